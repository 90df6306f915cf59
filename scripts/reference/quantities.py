"""What a command prints or writes as quantities: a dotted name, a value, a unit and a tolerance each.

Names come from the keys. What a list holds is named by its records' own names where these differ, else counted from 0.
A list or table of more than `MOST` values is kept as a few of its figures.
"""

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple, TypeGuard

MOST = 50
"""Values of an array that are kept one by one."""

LONGEST_WORD = 60
"""Characters of a word; what is longer is prose, and says again what the numbers say."""

Value = float | int | str | bool | None


class Quantity(NamedTuple):
    """A value with its unit ("" without one) and how far it may move, in that unit."""

    value: Value
    unit: str
    tolerance: float


class Found(NamedTuple):
    """A value as it was found; `largest` is the largest magnitude in the array that it is of, else its own."""

    name: str
    value: Value
    unit: str
    largest: float


# ----------------------------------------------------------------------------------------------------------- left out
LEFT_OUT = {
    r".*sha256.*|hashes|versions|microrad|files_sha256": "differs with every edit",
    r"folder|files?|path|report|mirror_file|ledger|written": "a path",
    r".*_ns|left_s|rows_per_s|seconds": "time of this machine",
    r"stack": "that of this machine's compiler",
    r"edges|counts": "a histogram, whose bins a value at an edge leaves",
    r".*_utc": "the same moment stands beside it in seconds",
    r"unit|units|long_name|meaning|holds_for|source|authority|caveat|why|basis": "words about a number",
    r"at_hz|largest_error": "where rounding happens to be largest, and how large",
}
"""Keys that are no quantities, and why."""

_LEFT_OUT = re.compile("|".join(f"(?:{pattern})" for pattern in LEFT_OUT))

# --------------------------------------------------------------------------------------------------------------- units
UNITS = {
    "rad2_hz": "rad^2/Hz",
    "photons_per_bit": "photon/bit",
    "photon_bit": "photon/bit",
    "rad_s2": "rad/s^2",
    "rad_v": "rad/V",
    "bit_s": "bit/s",
    "rad_s": "rad/s",
    "per_s": "1/s",
    "v_s": "V/s",
    "m_s": "m/s",
    "percent": "%",
    "dbm": "dBm",
    "dbi": "dBi",
    "rad": "rad",
    "deg": "deg",
    "bit": "bit",
    "db": "dB",
    "hz": "Hz",
    "s": "s",
    "w": "W",
    "v": "V",
    "m": "m",
    "a": "A",
    "k": "K",
}
"""Unit by the end of a key, the longest first."""

_SUFFIX = re.compile(r"_(" + "|".join(sorted(UNITS, key=len, reverse=True)) + r")(?:_per_axis|_\d+)?$")

_PLAIN = re.compile(r"probability|confidence|rows|share|.*_share|count|.*_number|samples|factor|.*_factor")
"""Keys of pure numbers within a record that has a unit."""


def _unit_of(key: str, around: str) -> str:
    """Unit of a key by its own end, else the one of the record that it stands in."""
    if suffix := _SUFFIX.search(key.lower()):
        return UNITS[suffix[1]]
    return "" if _PLAIN.fullmatch(key) else around


# ---------------------------------------------------------------------------------------------------------- flattening
def flatten(data: Any, name: str = "", unit: str = "") -> Iterator[Found]:
    """Every number and short word in a JSON document, by its dotted name."""
    if isinstance(data, Mapping):
        own = data.get("unit", data.get("units"))
        around = own if isinstance(own, str) else unit
        for key, value in data.items():
            if not _LEFT_OUT.fullmatch(key):
                yield from flatten(value, _joined(name, key), _unit_of(key, around))
    elif isinstance(data, list | tuple):
        yield from _listed(data, name, unit)
    elif _is_number(data):
        yield Found(name, data, unit, abs(data))
    elif data != "" and len(str(data)) <= LONGEST_WORD:
        yield Found(name, str(data) if isinstance(data, float) else data, "", 0.0)


def _listed(data: Sequence[Any], name: str, unit: str) -> Iterator[Found]:
    if data and all(isinstance(item, Mapping) for item in data):
        if len(data) > MOST:
            keys = sorted({key for item in data for key in item})
            yield from flatten({key: [item.get(key) for item in data] for key in keys}, name, unit)
            return
        key, labels = _labels(data)
        for label, item in zip(labels, data, strict=True):
            yield from flatten({k: value for k, value in item.items() if k != key}, _joined(name, label), unit)
        return
    leaves = list(_leaves(data))
    numbers = [value for value in leaves if _is_number(value)]
    if numbers and all(value is None or isinstance(value, int | float) for value in leaves):
        yield from _array(data, numbers, name, unit)
    elif len(leaves) > MOST:
        yield Found(_joined(name, "count"), len(leaves), "", 0.0)
    else:
        for i, item in enumerate(data):
            yield from flatten(item, _joined(name, str(i)), unit)


def _array(data: Sequence[Any], numbers: list[float], name: str, unit: str) -> Iterator[Found]:
    """An array: each of its numbers where they are few, else what tells them apart; all on the scale of the largest."""
    largest = max(abs(number) for number in numbers)
    if len(numbers) > MOST:
        yield Found(_joined(name, "count"), len(numbers), "", 0.0)
        mean = math.fsum(numbers) / len(numbers)
        rms = math.sqrt(math.fsum(number * number for number in numbers) / len(numbers))
        few = {"first": numbers[0], "last": numbers[-1], "min": min(numbers), "max": max(numbers)}
        for label, value in (few | {"mean": mean, "rms": rms}).items():
            yield Found(_joined(name, label), float(value), unit, largest)
        return
    for i, item in enumerate(data):
        for found in flatten(item, _joined(name, str(i)), unit):
            yield found._replace(largest=largest)


def _labels(records: Sequence[Mapping[str, Any]]) -> tuple[str, list[str]]:
    """The key that names the records, and their names; "" and their numbers where none does."""
    for key in ("name", "key", "input", "model"):
        labels = [record.get(key) for record in records]
        if all(isinstance(label, str) for label in labels) and len(set(labels)) == len(labels):
            return key, [str(label) for label in labels]
    return "", [str(i) for i in range(len(records))]


def _leaves(data: object) -> Iterator[object]:
    if isinstance(data, list | tuple):
        for item in data:
            yield from _leaves(item)
    else:
        yield data


def _joined(name: str, key: str) -> str:
    return f"{name}.{key}" if name else key


def _is_number(value: object) -> TypeGuard[float]:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


# ---------------------------------------------------------------------------------------------------------- tolerances
class Kind(NamedTuple):
    """How far a quantity may move: by a share of itself (or of the largest in its array) and so much of a unit."""

    relative: float
    absolute: Mapping[str, float]
    reason: str


CLOSED = Kind(1e-9, {"": 1e-12}, "closed form: rounding, which libraries sum in another order")
EXACT = Kind(0.0, {}, "counts and words; tuned parameters, which are the same on every machine")
EVENT = Kind(1e-11, {"s": 4e-6}, "events are bracketed to 1 µs, and what lies between two moves with both")
ORBIT = Kind(1e-8, {"": 1e-9}, "what is integrated or extreme between two events moves with these")
LINEAR = Kind(1e-6, {"": 1e-9, "V": 1e-12}, "linear theory: eigenvalues, Riccati equations and roots on a refined grid")
SINES = Kind(1e-4, {"rad": 6e-8, "dB": 0.01, "V": 1e-3, "bit/s": 1e6}, "a sample may round the other way: 27 nrad")
ENSEMBLE = Kind(
    5e-3,
    {"rad": 2e-9, "dB": 0.005, "": 1e-5, "bit/s": 4e5},
    "64 noisy runs, of which a rounded sample moves single ones: far below their own 99 % interval",
)
RARE = Kind(0.2, {"": 1e-6, "1/s": 1e-6}, "tails go with the exponential of the square of an error that may move")
FITTED = Kind(1e-4, {"rad": 1e-10, "": 1e-9}, "a search ends where its cost falls by 1e-9: 3e-5 of a parameter")
SEARCHED = Kind(
    5e-3,
    {"rad": 1e-10, "rad/V": 1e-12, "": 1e-4},
    "searches along flat valleys end where they are: far within the standard errors of what is barely told apart",
)
BARELY = Kind(
    0.03,
    {"rad": 1e-10, "rad/V": 1e-12, "": 1e-3},
    "errors of poles beyond the excited band, and parameters known to 9 % at best: a third of their standard errors",
)
INDEX = Kind(0.05, {"": 0.01}, "shares of a variance, known from so many rows to some per cent of the whole")

_ORBITS = r"contacts|constellation|gallery-constellation"
_SPAN = r".*(?<!rad)(?<!bit)(?<!m)_s"
_LOOPS = r"mission.*|gallery-mirrors|mirror-.*"

KINDS: Sequence[tuple[str, str, Kind]] = (
    (r"design|mission.*|gallery-mirrors", r".*(\.|^)(tuned\..*|parameters\.[^.]*\.value)", EXACT),
    (_ORBITS, _SPAN, EVENT),
    (_ORBITS, r".*", ORBIT),
    (r"gallery-crosslink", rf"contacts\.{_SPAN}", EVENT),
    (r"gallery-crosslink", r"contacts\..*", ORBIT),
    (_LOOPS, r".*hysteresis_loops.*|.*margin_map.*|paper\b.*", CLOSED),
    (_LOOPS, r".*(fade|outage|below_required|share|rare).*", RARE),
    (r"mirror-.*", r"export\..*", LINEAR),
    (r"mirror-.*", r".*", SINES),
    (r"mission.*", r"tracking.*|runs\..*|other_readings.*|residual.*|requirements.*", SINES),
    (r"mission.*", r"day\.(contacts|passes|direct\w*|line_of_sight)\b(?!.*could_carry).*", ORBIT),
    (r"mission.*|gallery-mirrors", r"(.*\.)?(margins|theory|theory_\w+|bound|stroke)\b.*", LINEAR),
    (r"mission.*|gallery-mirrors", r".*", ENSEMBLE),
    (r"design|export-c", r".*simulated_rms.*", ENSEMBLE),
    (r"design|export-.*", r".*", LINEAR),
    (r"campaign.*", r"rows\.(communication|fine_pointing)\..*", CLOSED),
    (r"campaign.*", r".*(miss|outage|tail).*", RARE),
    (r"campaign.*", r".*sensitivities.*", INDEX),
    (r"campaign.*", r".*", ENSEMBLE),
    (r"identify-whole", r"parameters\.bouc_wen_.*|linear\.poles_and_zeros\..*_error.*", BARELY),
    (r"identify-whole|gallery-lab", r".*", SEARCHED),
    (r"identify-.*", r".*", FITTED),
    (r".*", r".*", CLOSED),
)
"""Which kind a quantity is of: patterns of the case and of the name; the first line that fits both counts."""


def quantities(case: str, data: object) -> dict[str, Quantity]:
    """Quantities of a case, by name."""
    return {found.name: Quantity(found.value, found.unit, tolerance(case, found)) for found in flatten(data)}


def tolerance(case: str, found: Found) -> float:
    """How far a value may move, rounded to one digit so that it does not move itself."""
    if not isinstance(found.value, float) or not math.isfinite(found.value):
        return 0.0
    kind = next(kind for cases, names, kind in KINDS if re.fullmatch(cases, case) and re.fullmatch(names, found.name))
    return float(f"{kind.relative * found.largest + kind.absolute.get(found.unit, 0.0):.0e}")
