"""What the benchmarks of a release found, in one file: benchmarks/results/VERSION.json.

MICRORAD_RECORD=yes python benchmarks/loop.py    keeps what it finds there; without the variable nothing is kept
scripts/benchmarks_page.py                       writes docs/benchmarks.md and its figure from these files
"""

import json
import os
import sys
import time
from pathlib import Path
from typing import Any

import microrad
from microrad.core import machine

FOLDER = Path(__file__).resolve().parent / "results"


def record(
    what: str, value: float, unit: str = "", *, at_most: float | None = None, at_least: float | None = None
) -> None:
    """Keep a figure of the benchmark that is running, in place of an earlier one of the same name.

    Args:
        what: What was measured, in words.
        value: What was found, of which three digits are kept.
        unit: Its unit; "" for a ratio.
        at_most: The bar, where a smaller value is better.
        at_least: The bar, where a larger value is better.

    Raises:
        SystemExit: if the file holds figures of another machine or of other libraries.
    """
    if not os.environ.get("MICRORAD_RECORD"):
        return
    version = microrad.__version__.removesuffix(".dev0")
    here = {"machine": {**machine.machine(), "cores": os.cpu_count()}, "versions": machine.versions()}
    here["versions"] = {name: found for name, found in here["versions"].items() if name != "microrad"}
    path = FOLDER / f"{version}.json"
    kept: dict[str, Any] = {"version": version, **here, "rows": []}
    if path.exists():
        kept = json.loads(path.read_text(encoding="utf-8"))
        if {name: kept[name] for name in here} != here:
            raise SystemExit(f"{path} is of another machine or of other libraries: delete it, and record all anew")
    row = {
        "benchmark": Path(sys.argv[0]).stem,
        "what": what,
        "value": float(f"{value:.3g}"),
        "unit": unit,
        "at_most": at_most,
        "at_least": at_least,
        "date": time.strftime("%Y-%m-%d", time.gmtime()),
    }
    others = [each for each in kept["rows"] if (each["benchmark"], each["what"]) != (row["benchmark"], what)]
    kept["rows"] = sorted([*others, row], key=lambda each: each["benchmark"])
    path.parent.mkdir(exist_ok=True)
    path.write_text(json.dumps(kept, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
