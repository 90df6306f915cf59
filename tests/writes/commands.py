"""The commands that write, each on the smallest files that take it through all its writes."""

import os
import sqlite3
import sys
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest

from microrad import cli
from microrad.campaign import run
from small_campaign import campaign_file, without_worker
from writes.layer import Command

PATCH = pytest.MonkeyPatch()


def here_alone() -> None:
    """Rows are computed in the process of the command, and nothing beside it: its writes have one order."""
    without_worker(PATCH)
    PATCH.setattr(os, "cpu_count", lambda: 1)
    for module, name, known in COMPUTED:
        PATCH.setattr(module, name, _once(getattr(module, name), known))


def _once(function: Callable[..., Any], known: Callable[..., Any]) -> Callable[..., Any]:
    """A function that computes once in all runs: what it returns does not depend on what can be written."""
    results = dict[Any, Any]()

    def found(*args: Any, **more: Any) -> Any:
        key = known(*args)
        if key not in results:
            results[key] = function(*args, **more)
        return results[key]

    return found


COMPUTED = ((run, "controllers", lambda campaign, *_: campaign.text),)


def typed(*words: str) -> Callable[[], int]:
    """A command as it is typed, run in this process; its exit code."""

    def does() -> int:
        sys.argv = ["microrad", *words]
        try:
            cli.main()
        except SystemExit as ended:
            return int(ended.code or 0)
        return 0

    return does


# ----------------------------------------------------------------------------------------------------------- campaigns
def rows_of(path: Path) -> dict[str, Any]:
    """What of a ledger is the same in each run."""
    with closing(sqlite3.connect(path)) as ledger:
        assert ledger.execute("PRAGMA integrity_check").fetchone() == ("ok",)
        found = {name: ledger.execute(f"SELECT * FROM {name} ORDER BY 1, 2, 3").fetchall() for name in ("chunks", "traces")}
        notes = dict(ledger.execute("SELECT key, value FROM notes"))
        return found | {"notes": sorted(notes), "state": notes.get("state")}


GRID = """
[grid]
"terminals.leo_aperture" = ["6 cm", "7 cm"]

[limits.margin]
least = "1 dB"
"""


def _campaign(here: Path) -> None:
    campaign_file(here, runs=4, worst=1, more=GRID)


LEDGER: dict[str, Any] = {
    "content": {"*.ledger": rows_of, "*.ledger-*": lambda path: None},
    "partly": {"*.ledger": rows_of, "*.ledger-*": lambda path: None},
}

COMMANDS = (
    Command("init", typed("init")),
    Command("init --preset", typed("init", "--preset", "click", "click.toml")),
    Command("campaign init", typed("campaign", "init")),
    Command(
        "campaign run",
        typed("campaign", "run", "campaign.toml"),
        _campaign,
        typed("campaign", "resume", "campaign.ledger"),
        **LEDGER,
    ),
)
