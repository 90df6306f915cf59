"""What commands say and draw, as lines of text: word for word, and each curve by a few of its figures.

Left out is what differs from run to run or from machine to machine: hashes, versions, paths, times of this machine.
"""

import csv
import difflib
import json
import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import fields, is_dataclass
from functools import cached_property
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np

from reference.quantities import flatten

DIGITS = 4
"""Of a figure of a curve."""

LONG = 6
"""Digits behind the point from which a number is no printed one, but one that is read again."""

NEGLIGIBLE = 1e-9
"""Of the largest magnitude of a curve: what is smaller counts as 0, as a mean of a sine."""

UNSETTLED = re.compile(
    r"monte-carlo-tail|quantisation|too few samples|share of the time beyond|annotations\[\d+\]\.(?:[xy]|text: [\d.]+$)"
    r"|^plot of output about the bias|disturbance observer"
)
"""Lines of a simulated loop that a rounding moves by more than `NEAR`: tails, small parts, the points that a figure is
thinned to, and what the disturbance observer leaves, whose optimum is flat (the case `design` has it).
"""

NEAR = 0.02
"""By which share a number may be another one; or by two of its last decimal place, or by one."""

_NUMBER = re.compile(r"(?<![\w.])\d+(?:\.\d+)?(?:e[+-]?\d+)?(?![\w.]*\w)")

DISTINCT = re.compile(r", \d+ distinct(?=: )")
"""How many values of a row differ, which a rounding decides where values come again."""

BLOCKS = {"p", "h1", "h2", "h3", "h4", "tr", "li", "figcaption", "summary", "div", "dt", "dd", "pre", "caption"}
CELLS = {"td", "th"}
SKIPPED = {"script", "style", "svg", "head"}

LEFT_OUT = (
    (r"\{[0-9a-f]{8}(?:-[0-9a-f]{4}){3}-[0-9a-f]{12}\}", "{UUID}"),
    (r"(?<![\w.])(?=\d*[a-f])[0-9a-f]{12,64}\b|(?<=SHA-256 )[0-9a-f]{12,64}\b", "HASH"),
    (r"(?<![\w.])0\.\d+\.\d+(?:\.dev\d+)?(?:\+\w+)?\b", "VERSION"),
    (r"^Made with .*$", "Made with VERSIONS."),
    (r"^machine \| .*$", "machine"),
    (r"(?:/[\w.-]+)*/microrad-numbers-\w+", "FOLDER"),
    (r" in [\d.]+ (?:ms|s|min), [\d.e+]+ rows a second", " in TIME, so many rows a second"),
)
"""What differs from run to run, and what stands in its place."""

PLOTTED = {"name", "x", "y", "z", "text", "base", "error_x", "error_y", "array", "arrayminus", "title", "range", "type"}
PLOTTED |= {"data", "layout", "xaxis", "yaxis", "shapes", "annotations", "x0", "x1", "y0", "y1", "label", "tickvals"}
PLOTTED |= {"ticktext", "keys", "entries", "mode", "fill", "hovertemplate", "width"}
"""Keys of an interactive figure that are kept: what is drawn and said, not how it looks."""


def load(path: Path) -> list[str]:
    """Lines of a file of the reference; none where there is no such file."""
    return path.read_text(encoding="utf-8").splitlines() if path.exists() else []


def save(path: Path, lines: Sequence[str]) -> None:
    """Write a file of the reference."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def differences(name: str, was: Sequence[str], now: Sequence[str], *, simulated: bool) -> list[str]:
    """Lines that are not what they were, with - what was and + what is.

    Args:
        name: The case, in front of each.
        was: Lines of the reference.
        now: Lines as they are said now.
        simulated: Of loops with quantisers, which part from each other by a rounding: numbers may be others by `NEAR`.
    """
    words = [[_NUMBER.sub("#", line) for line in lines] for lines in (was, now)]
    found: list[str] = []
    for kind, i, k, j, m in difflib.SequenceMatcher(None, *words, autojunk=False).get_opcodes():
        old, new = was[i:k], now[j:m]
        if kind == "equal":  # but for numbers
            apart = [each for each in zip(old, new, strict=True) if each[0] != each[1]]
            apart = [each for each in apart if not (simulated and _alike(*each))]
            old, new = [each[0] for each in apart], [each[1] for each in apart]
        found += [f"{name}: - {line}" for line in old] + [f"{name}: + {line}" for line in new]
    return found


def _alike(was: str, now: str) -> bool:
    """Whether two lines of the same words have nearly the same numbers."""
    old, new = _NUMBER.findall(was), _NUMBER.findall(now)
    values = was.rpartition(": ")[2]  # a short curve whole, whose values have one unit
    least = NEAR * max(map(float, _NUMBER.findall(values)), default=0.0) if not values.strip("-+.e0123456789 ") else 0.0
    return all(_near(*each, least) for each in zip(old, new, strict=True))


def _near(was: str, now: str, least: float) -> bool:
    mantissa, _, exponent = was.partition("e")
    last_place = 10.0 ** (int(exponent or 0) - len(mantissa.partition(".")[2]))
    return abs(float(was) - float(now)) <= max(least, NEAR * abs(float(was)), 2.001 * last_place if "." in was else 1.0)


def numbers(data: Any, digits: int = DIGITS) -> list[str]:
    """Each number and short word of a JSON document, a line each.

    Args:
        data: The document.
        digits: Of a number.
    """
    return [f"{name}: {_short(value, digits)} {unit}".rstrip() for name, value, unit, _ in flatten(data)]


def _short(value: object, digits: int) -> str:
    return f"{value:.{digits}g}" if isinstance(value, float) else str(value)


def shortened(lines: Iterable[str], digits: int = DIGITS) -> list[str]:
    """Lines with the long numbers of what is written to be read back cut to so many digits.

    Args:
        lines: The lines.
        digits: Of a number with more than `LONG` of them behind its point.
    """
    number = re.compile(rf"(?<![\w.])-?\d+\.\d{{{LONG},}}(?:e[+-]?\d+)?(?![\w.])")
    return [re.sub(r" +#", " #", number.sub(lambda found: f"{float(found[0]):.{digits}g}", line)) for line in lines]


def plain(text: str) -> list[str]:
    """Lines of a text without what is left out."""
    return [_kept(line.rstrip()) for line in text.splitlines()]


def _kept(line: str) -> str:
    for pattern, word in LEFT_OUT:
        line = re.sub(pattern, word, line)
    return line


class _Page(HTMLParser):
    """The words of a page, a block a line and cells side by side, and its figures' data."""

    def __init__(self) -> None:
        super().__init__()
        self.lines: list[str] = []
        self.plots: list[str] = []
        self._words: list[str] = []
        self._inside = 0
        self._plot = False

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        if tag in BLOCKS:
            self._end()
        self._inside += tag in SKIPPED
        self._plot = tag == "script" and dict(attrs).get("class") == "plot"

    def handle_endtag(self, tag: str) -> None:
        if tag in SKIPPED:
            self._inside -= 1
            self._plot = False
        if tag in CELLS:
            self._words.append(" | ")
        if tag in BLOCKS:
            self._end()

    def handle_data(self, data: str) -> None:
        if self._plot:
            self.plots.append(data)
        elif not self._inside:
            self._words.append(data)

    def _end(self) -> None:
        line = re.sub(r"\s+", " ", "".join(self._words)).strip().rstrip("| ")
        if line:
            self.lines.append(_kept(line))
        self._words = []


def settled(lines: Sequence[str]) -> list[str]:
    """Lines of a simulated loop without what a rounding moves: tails of few samples, least values."""
    return [
        re.sub(r" \d+ distinct:|(?:first|last|min) \S+ ?", "", line) for line in lines if not UNSETTLED.search(line)
    ]


def page(path: Path, digits: int = DIGITS, negligible: float = NEGLIGIBLE) -> list[str]:
    """A report: its words, then its interactive figures.

    Args:
        path: The page.
        digits: Of a figure of a curve.
        negligible: Share of the largest magnitude of a curve below which a figure counts as 0.
    """
    how = digits, negligible
    read = _Page()
    read.feed(path.read_text(encoding="utf-8"))
    read.close()
    return [
        *read.lines,
        *(line for plot in map(json.loads, read.plots) for line in _plotted(plot, f"plot of {_drawn(plot)}", how)),
    ]


def _drawn(plot: Any) -> str:
    """What stands on the vertical axis of a figure."""
    return str(plot["layout"].get("yaxis", {}).get("title", {}).get("text", ""))


def _plotted(data: Any, name: str, how: tuple[int, float]) -> Iterator[str]:
    """What an interactive figure draws; `how` are the last two arguments of `curve`."""
    if isinstance(data, dict):
        for key, value in data.items():
            if re.sub(r"\d+$", "", key) in PLOTTED or key in PLOTTED:
                yield from _plotted(value, f"{name}.{key}", how)
    elif isinstance(data, list) and data and all(_is_number(each) or each is None for each in data):
        yield f"{name}: {curve([math.nan if each is None else each for each in data], *how)}"
    elif isinstance(data, list) and data and all(isinstance(each, str) for each in data):
        yield f"{name}: {len(data)} {' ; '.join(dict.fromkeys(data[:20]))}"
    elif isinstance(data, list):
        for i, each in enumerate(data):
            yield from _plotted(each, f"{name}[{i}]", how)
    elif isinstance(data, str):
        yield f"{name}: {' '.join(data.splitlines())}"
    elif _is_number(data):
        yield f"{name}: {data:.{how[0]}g}"


def flat(name: str, data: Any) -> Iterator[str]:
    """All that a value holds, a line each: of records their fields, of arrays their shape and what tells them apart.

    Args:
        name: What stands before each line.
        data: A record, a JSON document, numbers or words.
    """
    data = _fields(data)
    if isinstance(data, Mapping):
        for key, value in data.items():
            yield from flat(f"{name}.{key}", value)
    elif isinstance(data, set | frozenset):
        yield from flat(name, sorted(data, key=str))
    elif isinstance(data, list | tuple | np.ndarray):
        try:
            values = np.asarray(data)
        except ValueError:  # lists that are not equally long
            values = np.empty(0, dtype=object)
        if values.dtype.kind in "iufc":
            yield from _array(name, values)
        else:
            for i, each in enumerate(data):
                yield from flat(f"{name}[{i}]", each)
    elif isinstance(data, float | complex | np.inexact):
        yield f"{name}: {data:.{DIGITS}g}"
    elif isinstance(data, bytes):
        yield from flat(name, data.decode())
    elif data is None or isinstance(data, str | int | np.generic | Path):
        yield _kept(f"{name}: {' / '.join(str(data).splitlines())}")
    else:
        yield f"{name}: a {type(data).__name__}"


def _fields(data: Any) -> Any:
    """A record as its fields and properties by name; whatever else as it is."""
    if is_dataclass(data) and not isinstance(data, type):
        known = {name: value for kind in reversed(type(data).__mro__) for name, value in vars(kind).items()}
        computed = [name for name, value in known.items() if isinstance(value, property | cached_property)]
        names = [*(field.name for field in fields(data)), *computed]
        return {name: _value(data, name) for name in names if not name.startswith("_")}
    return data._asdict() if hasattr(data, "_asdict") else data


def _value(data: Any, name: str) -> Any:
    try:
        return getattr(data, name)
    except (ValueError, ArithmeticError) as refused:
        return f"refused: {refused}"


def _array(name: str, values: np.ndarray) -> Iterator[str]:
    shape = f" {'x'.join(map(str, values.shape))}" if values.ndim > 1 else ""
    parts = [("", values)] if values.dtype.kind != "c" else [(" real", values.real), (" imaginary", values.imag)]
    for part, found in parts:
        yield f"{name}{part}{shape}: {DISTINCT.sub('', curve(found.astype(float).ravel().tolist()))}"


def table(path: Path) -> list[str]:
    """A table of numbers in a file: each column by a few of its figures, what is no number by its words."""
    with path.open(encoding="utf-8", newline="") as file:
        heading, *rows = csv.reader(line for line in file if not line.startswith("#"))
    found = [f"{path.name}: {len(rows)} rows"]
    for i, title in enumerate(heading):
        cells = [row[i] if i < len(row) else "" for row in rows]
        try:
            told = curve([float(cell or "nan") for cell in cells])
        except ValueError:
            told = " ; ".join(dict.fromkeys(cells[:20]))
        found.append(f"{path.name}: {title}: {told}")
    return [_kept(line) for line in found]


def curve(values: Sequence[float], digits: int = DIGITS, negligible: float = NEGLIGIBLE) -> str:
    """What tells a curve apart; a short one whole.

    Args:
        values: Of the curve.
        digits: Of each of its figures.
        negligible: Share of the largest magnitude below which a figure counts as 0.
    """

    def said(value: float, digits: int = digits) -> str:
        if not math.isfinite(value):
            return str(value)
        return f"{0.0 if abs(value) < negligible * largest else value:.{digits}g}"

    finite = [each for each in values if math.isfinite(each)]
    largest = max(map(abs, finite), default=0.0)
    if len(values) <= 8:
        return " ".join(said(each) for each in values)
    if not finite:
        return f"{len(values)} without a number"
    mean = math.fsum(finite) / len(finite)
    slope = math.fsum(each * i for i, each in enumerate(finite)) / len(finite) ** 2
    rms = math.sqrt(math.fsum(each * each for each in finite) / len(finite))
    figures = {"first": finite[0], "last": finite[-1], "min": min(finite), "max": max(finite), "mean": mean}
    figures |= {"rms": rms, "slope": slope}
    return f"{len(values)}, {len(finite)}, {len({said(each, 9) for each in finite})} distinct: " + ", ".join(
        f"{k} {said(v)}" for k, v in figures.items()
    )


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def study(folder: Path) -> list[str]:
    """What a study or an identification leaves in a folder: its page, the data of its figures, its plans."""
    found: list[str] = []
    for path in sorted(folder.rglob("*")):
        name = path.relative_to(folder).as_posix()
        if path.suffix == ".html":
            found += [f"== {name}", *page(path)]
        elif path.suffix == ".csv":
            found += table(path)
        elif path.suffix in {".ionrc", ".toml"}:
            found += [f"== {name}", *plain(path.read_text(encoding="utf-8"))]
        elif path.is_file() and path.suffix not in {".svg", ".json"}:
            found.append(f"== {name}")
    return found
