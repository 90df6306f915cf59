"""Two missions beside each other: the keys that differ, what their links come to, and what their studies found."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from decimal import Decimal
from pathlib import Path
from typing import Any

from microrad.core.folder import MANIFEST, read_bytes
from microrad.core.units import UnitError, parse_quantity
from microrad.link import study as link_study
from microrad.mission.toml import value_of
from microrad.report.quantities import MINUS, apart, plain, quantity
from microrad.report.tables import Cell, Table
from microrad.report.view import Soft, Verdict, View, told
from microrad.studio.draft.draft import Draft, Value
from microrad.studio.session import Session
from microrad.studio.views.link import ROUNDING_DB

_MOST_FOLDERS = 500
_MOST_BYTES = 5_000_000
_ABSENT = "not given"


@dataclass(frozen=True, slots=True)
class Number:
    """A number of one mission: its name, value and unit (SI), and what is required of it, if anything is."""

    name: str
    value: float
    unit: str
    required: str = ""
    met: bool | None = None

    @property
    def text(self) -> str:
        """The value with its unit."""
        return quantity(self.value, self.unit) if self.unit else plain(self.value, 4)


def blocks(session: Session, here: Draft, there: Draft, names: tuple[str, str]) -> tuple[View, ...]:
    """The tables of two missions: what follows from their links, their studies, and what differs.

    Args:
        session: whose working folder has the studies.
        here: the first mission.
        there: the second.
        names: what both are called.
    """
    (links, why), (others, why_not) = _links(here), _links(there)
    studies = [finished_study(session, each) for each in (here, there)]
    faults = [
        Verdict(f"{name} has no link budget:\n{fault}", (), False)
        for name, fault in zip(names, (why, why_not), strict=True)
        if fault
    ]
    verdicts = [
        Verdict(f"{name}: {each.verdict} ({each.folder})", (), each.met)
        if each
        else Soft(f"{name}: no study of this text is in the folder; the page Runs makes one.")
        for name, each in zip(names, studies, strict=True)
    ]
    ours, theirs = (() if each is None else each.numbers for each in studies)
    differ = differences(here, there)
    count = f"{len(differ)} key{'s differ' if len(differ) > 1 else ' differs'}; a table that one of them lacks is one."
    columns = ("key", *(f"in {name}" for name in names))
    return (
        View("Links", told(*faults, _numbers(links, others, names))),
        View("Verdicts", told(*verdicts, _numbers(ours, theirs, names))),
        View("Differences", (count, Table("", columns, differ, words=range(3))))
        if differ
        else View("Differences", (Soft("Every key has the same value in both."),)),
    )


def _links(draft: Draft) -> tuple[tuple[Number, ...], str]:
    """What follows from the links, and why nothing does."""
    try:
        return link_numbers(draft), ""
    except ValueError as error:
        return (), str(error)


def _numbers(ours: Sequence[Number], theirs: Sequence[Number], names: tuple[str, str]) -> Table | None:
    rows = beside(ours, theirs)
    return Table("", ("number", *(f"in {name}" for name in names), "change"), rows) if rows else None


def beside(ours: Sequence[Number], theirs: Sequence[Number]) -> list[tuple[str | Cell, ...]]:
    """The numbers of both by name, in the order of the first, then of the second, and the second less the first.

    Args:
        ours: numbers of the first mission.
        theirs: numbers of the second.
    """
    first, second = {n.name: n for n in ours}, {n.name: n for n in theirs}
    pairs = {name: (first.get(name), second.get(name)) for name in (*first, *second)}
    return [(name, *_row(a, b)) for name, (a, b) in pairs.items()]


def _row(here: Number | None, there: Number | None) -> tuple[str | Cell, str | Cell, str]:
    """Both numbers, with as many more digits as it takes to tell them apart, and the change."""
    if here is None or there is None:
        return _cell(here), _cell(there), ""
    texts = (here.text, there.text)
    if texts[0] == texts[1]:
        texts = apart(here.value, there.value, here.unit)
    if texts[0] == texts[1]:
        return _cell(here), _cell(there), "same"
    change = there.value - here.value
    size = Number("", -abs(change), here.unit).text.removeprefix(MINUS)  # small decibels below 0 have their digits
    return _cell(here, texts[0]), _cell(there, texts[1]), f"{MINUS if change < 0.0 else '+'}{size}"


def _cell(number: Number | None, text: str = "") -> str | Cell:
    if number is None or number.met is None:
        return "none" if number is None else text or number.text
    return Cell(f"{text or number.text}, required {number.required}", "PASS" if number.met else "FAIL")


def differences(here: Draft, there: Draft) -> list[tuple[str, str, str]]:
    """The keys whose values differ, in the order of the first mission, then of the second: key, values with sources.

    Quantities that are equal in other units ("5 cm", "50 mm") do not differ, nor do other words for the same number. A
    table that only one of them has is one difference, "[orbit]", with the number of its keys.

    Args:
        here: the first mission.
        there: the second.
    """
    ours, theirs = here.values, there.values
    found: dict[str, tuple[str, str, str]] = {}
    for key in dict.fromkeys((*ours, *theirs)):
        a, b = ours.get(key), theirs.get(key)
        table = key.partition(".")[0]
        alone = "." in key and not (_keys_of(table, ours) and _keys_of(table, theirs))
        if alone:
            found[table] = (f"[{table}]", _count(_keys_of(table, ours)), _count(_keys_of(table, theirs)))
        elif a is None or b is None or _meant(a) != _meant(b):
            found[key] = (key, _typed(a), _typed(b))
    return list(found.values())


def _typed(value: Value | None) -> str:
    return _ABSENT if value is None else "\n".join(filter(None, (value.typed, value.source)))


def _keys_of(table: str, values: dict[str, Value]) -> int:
    return sum(key.startswith(f"{table}.") for key in values)


def _count(keys: int) -> str:
    return f"{keys} key{'' if keys == 1 else 's'}" if keys else _ABSENT


def _meant(value: Value) -> object:
    """What a value means: a quantity in its SI unit, else what TOML makes of it."""
    unit = "" if value.about is None else value.about.unit
    data = value_of(value.raw, Decimal)
    if not unit:
        return (isinstance(data, bool), data) if data is not None else value.raw
    items = data if isinstance(data, list) else [data]
    with suppress(UnitError):
        return tuple(f"{parse_quantity(item, unit):.12g}" for item in items)
    return value.raw


# ------------------------------------------------------------------------------------------------------------- numbers
def link_numbers(draft: Draft) -> tuple[Number, ...]:
    """What follows from the tables of the links; raises ValueError with the reason where nothing does."""
    study = link_study.run_link_study(draft.link())
    required = study.file.mission.requirement.margin_db
    found = []
    for budget in study.budgets:
        least = required if budget is study.communication else 0.0
        met = budget.margin_db >= least - ROUNDING_DB
        found.append(Number(f"{budget.name}: margin", budget.margin_db, "dB", quantity(least, "dB"), met))
        found.append(Number(f"{budget.name}: received power", budget.received_power_w, "W"))
    rate = study.file.mission.communication.data_rate_bit_s
    found.append(Number("Data rate", float(rate), "bit/s"))
    if not math.isnan(study.largest_rate_bit_s):
        found.append(Number("Largest data rate with the required margin", study.largest_rate_bit_s, "bit/s"))
    if study.open_loop is not None:
        found.append(Number("Open-loop pointing error, root sum square", study.open_loop.rss_rad, "rad"))
    if study.finding is not None:
        outcome = study.finding.wide.outcome
        found.append(Number("Acquisition by the wide beacon: probability", outcome.success_probability, ""))
        if study.finding.wide.possible:
            found.append(Number("Acquisition by the wide beacon: mean time", outcome.mean_time_s, "s"))
    return tuple(found)


# ------------------------------------------------------------------------------------------------------------- studies
@dataclass(frozen=True, slots=True)
class Found:
    """A finished study of exactly this text: the folder of its results, its verdict, its requirements."""

    folder: str
    verdict: str
    met: bool
    numbers: tuple[Number, ...]


def finished_study(session: Session, draft: Draft) -> Found | None:
    """The latest study of the draft's text among the folders of the working folder; None where there is none.

    Args:
        session: the session of all tabs.
        draft: the mission.
    """
    found = []
    for path in sorted(session.folder.glob(f"*/{MANIFEST}"))[:_MOST_FOLDERS]:
        with suppress(OSError, ValueError, KeyError, TypeError, RecursionError, OverflowError):
            if path.stat().st_size > _MOST_BYTES:
                continue
            data = json.loads(read_bytes(path, _MOST_BYTES))
            if data["mission"]["sha256"] == draft.sha256:
                found.append((path.stat().st_mtime_ns, _found(path, data["summary"])))
    return max(found, key=lambda pair: pair[0])[1] if found else None


def _found(path: Path, summary: dict[str, Any]) -> Found:
    numbers = tuple(
        Number(
            str(each["name"]),
            float(each["actual"]),
            str(each["unit"]),
            quantity(float(each["required"]), str(each["unit"])),
            bool(each["met"]),
        )
        for each in summary["requirements"]
        if each["actual"] is not None and each["required"] is not None
    )
    return Found(path.parent.name, str(summary["verdict"]), all(r["met"] for r in summary["requirements"]), numbers)
