"""Write docs/benchmarks.md and docs/benchmarks.svg: what the benchmarks of each release found, beside their bars.

.venv/bin/python scripts/benchmarks_page.py      behind MICRORAD_RECORD=yes make benchmark
"""

import json
from collections.abc import Iterator
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np

from microrad.report.plotting.palette import BLUE, GREY, ORANGE
from microrad.report.plotting.sheet import Legend, Line, Rule, Sheet, rows
from microrad.report.plotting.svg import svg_of

ROOT = Path(__file__).resolve().parent.parent
RESULTS = ROOT / "benchmarks" / "results"
PAGE = ROOT / "docs" / "benchmarks.md"
FIGURE = PAGE.with_suffix(".svg")
Release = dict[str, Any]

HEAD = """# Benchmarks

Each benchmark is a file of `benchmarks/` and says in its first lines what it measures. A ratio compares microrad with
another program on the same machine in the same run. `MICRORAD_RECORD=yes make benchmark` runs those of a release
and keeps what they find in `benchmarks/results/VERSION.json`; `scripts/benchmarks_page.py` writes this page from it.
The last column says whether the bar is met. A figure without a bar is there to be compared with the next release.
<!-- promise: benchmarks-1 -->

![Each figure as a share of its bar, or as a ratio to another program](benchmarks.svg)
"""


def releases() -> list[Release]:
    """What is kept of each release, the oldest first."""
    found = [json.loads(path.read_text(encoding="utf-8")) for path in RESULTS.glob("*.json")]
    return sorted(found, key=lambda each: [int(part) for part in each["version"].split(".")])


def share(row: dict[str, Any]) -> float | None:
    """A figure as a share of its bar, at most 1 where that is met; None without a bar."""
    if row["at_most"] is not None:
        return float(row["value"] / row["at_most"])
    return float(row["at_least"] / row["value"]) if row["at_least"] is not None else None


def page(found: list[Release]) -> str:
    """The text: the last release's table, and on which machine it was made."""
    last = found[-1]
    return "\n".join([HEAD, f"## {last['version']}", "", *_made_on(last), *_tables(last)]) + "\n"


def _made_on(release: Release) -> Iterator[str]:
    of, days = release["machine"], sorted({row["date"] for row in release["rows"]})
    versions = ", ".join(f"{name} {release['versions'][name]}" for name in ("python", "numpy", "scipy", "numba"))
    when = f"on {days[0]}" if len(days) == 1 else f"from {days[0]} to {days[-1]}"
    yield f"Recorded {when} on {of['cores']} cores of kind {of['processor']} ({of['architecture']}), with {versions}."
    yield ""


def _tables(release: Release) -> Iterator[str]:
    for benchmark, group in groupby(release["rows"], key=lambda row: row["benchmark"]):
        yield from (f"### benchmarks/{benchmark}.py", "", "| figure | found | bar | met |", "|---|---|---|---|")
        for row in group:
            cells = (row["what"], _number(row["value"], row["unit"]), _bar(row), _word(row))
            yield f"| {' | '.join(cells)} |"
        yield ""


def _number(value: float, unit: str) -> str:
    return f"{value:,g} {unit}".strip().replace(",", " ")


def _bar(row: dict[str, Any]) -> str:
    for key in ("at_most", "at_least"):
        if row[key] is not None:
            return f"{key.replace('_', ' ')} {_number(row[key], row['unit'])}"
    return "–"


def _word(row: dict[str, Any]) -> str:
    of = share(row)
    return "–" if of is None else "yes" if of <= 1 else "no"


def ratio(row: dict[str, Any]) -> float | None:
    """A ratio to another program that has no bar; None of all else."""
    return float(row["value"]) if not row["unit"] and share(row) is None else None


PANELS = ((share, "share of the bar (1 or less: met)"), (ratio, "ratio without a bar, as it is named"))


def figure(found: list[Release]) -> Sheet:
    """What the last release found, as a share of its bar or as a ratio, and what earlier releases found there."""
    named = [[_key(row) for row in found[-1]["rows"] if of(row) is not None] for of, _ in PANELS]
    inches = [0.55 + 0.16 * len(names) for names in named]
    sheet = Sheet(7.6, 0.5 + sum(inches), tuple(inches), legend=Legend("above", columns=len(found) + 1))
    for place, ((of, title), names) in enumerate(zip(PANELS, named, strict=True)):
        panel = sheet.panel(place)
        panel.y = rows([f"{benchmark}: {what}" for benchmark, what in names], 6.0)
        panel.x.log, panel.x.title = True, title
        panel.add(Rule(1.0, True, ORANGE, "--", label="" if place else "1"))
        for release in found:
            values = {_key(row): of(row) for row in release["rows"]}
            at = np.array([np.nan if values.get(each) is None else values[each] for each in names], dtype=float)
            colour, label = BLUE if release is found[-1] else GREY, "" if place else release["version"]
            panel.add(Line(at, np.arange(at.size, dtype=float), colour, "", label=label, marker="o", size=4.0))
    return sheet


def _key(row: dict[str, Any]) -> tuple[str, str]:
    return row["benchmark"], row["what"]


def main() -> None:
    """Write both files."""
    found = releases()
    PAGE.write_text(page(found), encoding="utf-8")
    FIGURE.write_text(svg_of(figure(found)), encoding="utf-8")


if __name__ == "__main__":
    main()
