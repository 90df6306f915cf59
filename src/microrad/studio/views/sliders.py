"""Numbers of a mission that a slider moves: over which range, on which scale, and what a page shows of a new value.

A slider has whole positions from 0 to `Slider.steps`. What it writes keeps the unit that the mission has at that place.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from typing import Generic, Literal, TypeVar

from microrad.core.units import UnitError, parse_quantity
from microrad.mission.fields import Quantity, Share
from microrad.mission.file import LinkFile
from microrad.studio.draft.draft import Draft, Value

T = TypeVar("T")

STEPS = 240
"""The last position of a slider that is not in decibels."""

STEP_DB = 0.1
"""What a step in decibels takes."""

FACTOR = 4.0
"""How far a logarithmic slider reaches up and down from the value that it begins with, at least."""

REACH_DB = 10.0
"""How far a slider in decibels reaches up and down."""

_NUMBER = re.compile(r"([+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]{1,3})?) ?(.*)")
_ROUND = (1.0, 2.0, 5.0)
_LEVELS_W = {"dBm": 1e-3, "dBW": 1.0}
_CAPITALS = {"leo": "LEO", "geo": "GEO"}


@dataclass(frozen=True, slots=True)
class Slider:
    """A number of the mission with the range of its slider; `value`, `low` and `high` are in `unit`, as it is typed.

    `rule` has the kind of the number and its bounds. `scale` is "none" for what no slider moves: a word in place of a
    number, a zero without a range about it, a share near one.
    """

    key: str
    label: str
    typed: str
    rule: Quantity
    unit: str = ""
    scale: Literal["logarithmic", "linear", "none"] = "none"
    value: float = math.nan
    low: float = 0.0
    high: float = 0.0

    @property
    def steps(self) -> int:
        """The last position."""
        return max(round((self.high - self.low) / STEP_DB), 1) if self.unit.startswith("dB") else STEPS

    @property
    def position(self) -> int:
        """Where the slider stands."""
        if self.scale == "none":
            return 0
        low, high, value = self._on_scale(self.low), self._on_scale(self.high), self._on_scale(self.value)
        return min(max(round(self.steps * (value - low) / (high - low)), 0), self.steps)

    def at(self, position: int) -> str:
        """What a position stands for, as one types it; the position of the value is the value itself."""
        if position == self.position:
            return self.typed
        low, high = self._on_scale(self.low), self._on_scale(self.high)
        there = low + (high - low) * min(max(position, 0), self.steps) / self.steps
        number = float(f"{10.0**there:.3g}") if self.scale == "logarithmic" else round(there, _decimals(high - low))
        least, most = _bounds(self.rule, self.unit)
        return f"{min(max(number, least), most):.15g} {self.unit}".rstrip()

    def holding(self, typed: str) -> Slider:
        """The slider with another value; its range stays, and grows where the value lies outside."""
        found = read(typed, self.rule.unit)
        if found is None:
            return replace(self, typed=typed, scale="none")
        number, unit = found
        huge = unit.startswith("dB") and number + REACH_DB == number
        if unit != self.unit or self.scale == "none" or (number <= 0.0 and self.scale == "logarithmic") or huge:
            return _ranged(replace(self, typed=typed, value=number, unit=unit, scale="none"))
        return replace(self, typed=typed, value=number, low=min(self.low, number), high=max(self.high, number))

    def _on_scale(self, value: float) -> float:
        return math.log10(value) if self.scale == "logarithmic" else value


def slider(value: Value) -> Slider | None:
    """The slider of a value of a draft, or None for what is neither a number nor a quantity."""
    about = value.about
    if about is None or about.kind not in ("quantity", "number") or about.quantity is None:
        return None
    made, found = Slider(value.key, label(value.key), value.typed, about.quantity), read(value.typed, about.unit)
    return made if found is None else _ranged(replace(made, value=found[0], unit=found[1]))


def grouped(draft: Draft, order: Iterable[str], group: Callable[[str], str]) -> dict[str, tuple[Slider, ...]]:
    """The sliders of a draft by their groups, each in the order of the text.

    Args:
        draft: the mission that is edited.
        order: names of the groups; one without sliders is left out.
        group: the group of a key, "" for one that has no slider.
    """
    chosen = {key: (group(key), value) for key, value in draft.values.items() if group(key)}
    made = [(name, found) for name, value in chosen.values() if (found := slider(value)) is not None]
    groups = {name: tuple(each for of, each in made if of == name) for name in order}
    return {name: those for name, those in groups.items() if those}


def read(typed: str, si: str) -> tuple[float, str] | None:
    """Number and unit of what is typed, or None when it is no quantity in the SI unit `si` ("": no plain number).

    Args:
        typed: a number with its unit.
        si: the SI unit of its kind, "" for a plain number.
    """
    found = _NUMBER.fullmatch(typed.strip())
    if found is None or bool(found[2]) != bool(si) or not math.isfinite(float(found[1])):
        return None
    try:
        if si:
            parse_quantity(f"1 {found[2]}", si)
    except UnitError:
        return None
    return float(found[1]), found[2]


def label(key: str) -> str:
    """What a key is called beside its slider: "LEO aperture" for "terminals.leo_aperture"."""
    words = [_CAPITALS.get(word, word) for word in key.rpartition(".")[2].split("_")]
    return (words[0] if words[0] in _CAPITALS.values() else words[0].capitalize()) + "".join(f" {w}" for w in words[1:])


def faulty(draft: Draft, sliders: Iterable[str]) -> dict[str, str]:
    """What is wrong with each of these keys, in the words of the command line; only those with faults.

    Args:
        draft: the mission.
        sliders: keys.
    """
    told: dict[str, list[str]] = {}
    for fault in draft.problems:
        told.setdefault(fault.key, []).append(f"{fault.reason}; expected {fault.expected}")
    return {key: "; ".join(told[key]) for key in sliders if key in told}


# ------------------------------------------------------------------------------------------------------------- ranges
def _ranged(made: Slider) -> Slider:
    """A slider about its value: linear in decibels and for a plain number of zero between bounds, else by factors."""
    number, (least, most) = made.value, _bounds(made.rule, made.unit)
    if made.unit.startswith("dB"):
        low, high = max(number - REACH_DB, least), min(number + REACH_DB, most)
        return replace(made, scale="linear", low=low, high=high) if low < high else made
    if number > 0.0 and FACTOR * number > most:
        return made  # near its end, a share is no matter of factors
    if number > 0.0:
        low, high = _round_down(number / FACTOR), -_round_down(-number * FACTOR)
        low, high = max(low, least if least > 0.0 else low), min(high, most)
        return replace(made, scale="logarithmic", low=low, high=high) if low < high else made
    if math.isfinite(least) and math.isfinite(most) and least <= number <= most and not made.unit:
        return replace(made, scale="linear", low=least, high=most)
    return made


def _bounds(rule: Quantity, unit: str) -> tuple[float, float]:
    """What the mission allows, in the unit that is typed; infinite where it sets no bound."""
    least = rule.above if rule.least is None else rule.least
    most = rule.below if isinstance(rule, Share) else rule.most
    low = -math.inf if least is None else _in_unit(least, unit, rule.unit)
    return low, math.inf if most is None else _in_unit(most, unit, rule.unit)


def _in_unit(bound: float, unit: str, si: str) -> float:
    """A bound in SI, in the unit that is typed; -inf for a power of nothing in dBm."""
    if unit in _LEVELS_W:
        return 10.0 * math.log10(bound / _LEVELS_W[unit]) if bound > 0.0 else -math.inf
    try:
        return bound / parse_quantity(f"1 {unit}", si) if si and unit != si else bound
    except UnitError:
        return bound


def _round_down(value: float) -> float:
    """The next of 1, 2 or 5 times a power of ten that is not above the value, away from zero for a negative one."""
    power = 10.0 ** math.floor(math.log10(abs(value)))
    steps = [step * power for step in (*_ROUND, 10.0)]
    if value > 0.0:
        return max(step for step in steps if step <= value * (1.0 + 1e-9))
    return -min(step for step in steps if step >= -value * (1.0 - 1e-9))


def _decimals(span: float) -> int:
    """Decimals that tell the positions of a linear slider apart."""
    return max(0, 1 - math.floor(math.log10(span / 100.0))) if span > 0.0 else 2


# ----------------------------------------------------------------------------------------------------------- attempts
@dataclass(frozen=True, slots=True)
class Attempt(Generic[T]):
    """A draft and its view; without one, the draft's own faults say why, or `refusal` does."""

    draft: Draft
    view: T | None
    refusal: str = ""


def attempt(draft: Draft, key: str, typed: str, view: Callable[[LinkFile], T]) -> Attempt[T]:
    """What a value would do, read as the mission file is; raises `DraftError` for a key that has no place.

    Args:
        draft: the mission as it is.
        key: what is changed.
        typed: its value as one types it.
        view: what is shown of a mission.
    """
    return seen(draft.set(key, typed), view)


def seen(draft: Draft, view: Callable[[LinkFile], T]) -> Attempt[T]:
    """A draft as it is; a ValueError of `view` becomes the refusal.

    Args:
        draft: the mission.
        view: what is shown of one.
    """
    if draft.problems:
        return Attempt(draft, None)
    try:
        return Attempt(draft, view(draft.link()))
    except ValueError as error:  # a mission that is read, and cannot be budgeted
        return Attempt(draft, None, str(error))
