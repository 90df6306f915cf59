"""The search that a tuning does: candidates built, judged and counted, and their places within the bounds."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from microrad.core.arrays import Floats
from microrad.loop.control.analysis import loop_margins, refuse_misfit
from microrad.loop.control.judge import Judge, Verdict
from microrad.loop.control.problem import Family, Parameter, Specification

HEADROOM = 1e-3
"""Relative excess over what is asked for that a search aims at: rounding what it finds takes a little of it."""

PULL = 1e-3
"""Share of the rms that the most vigorous value of a parameter counts for: where less than that tells two candidates
apart, the gentler one is chosen (see `Parameter`), and the optimum is one point however flat the residual is."""


class Judging(Protocol):
    """Judges many controllers on the same plants; ``open_rad2`` is the mean variance without one."""

    open_rad2: float

    def several(self, controllers: Sequence[Any]) -> list[Verdict]:
        """Verdicts on controllers, in their order."""

    def unstable(self, pole: float) -> Verdict:
        """What is said of a candidate that is unstable, or that could not be built."""


class Margins(Protocol):
    """What a specification asks of a loop that is looked at closely."""

    @property
    def modulus(self) -> float:
        """Least distance from -1."""

    @property
    def bandwidth_hz(self) -> float:
        """Lowest frequency that is not rejected any more."""


@dataclass(frozen=True, slots=True)
class Scope:
    """What a search is about, one axis or all of them: how plants and controllers of its kind are looked at.

    ``judge`` makes a judge for plants; ``misfit`` and ``margins`` take a plant and a controller, and raise ValueError
    where the controller does not fit it.
    """

    judge: Callable[[Sequence[Any]], Judging]
    misfit: Callable[[Any, Any], None]
    margins: Callable[[Any, Any], Margins]


ONE_AXIS = Scope(Judge, refuse_misfit, loop_margins)


@dataclass(frozen=True, slots=True, eq=False)
class Trial:
    """One candidate: its place within the bounds (each coordinate in 0..1), what it reaches and by what it falls short.

    ``cost`` is the logarithm of the rms with the pull to gentle values. ``excess`` is relative to what is asked for,
    one number for each constraint, below 0 where it is not met.
    """

    place: Floats
    values: Floats
    verdict: Verdict
    cost: float
    excess: Floats

    @property
    def modulus(self) -> float:
        """Least modulus margin over the plants."""
        return float(np.min(self.verdict.moduli))

    @property
    def violation(self) -> float:
        """By how much the worst constraint is missed, 0 where everything is met."""
        return max(0.0, -float(np.min(self.excess)))

    @property
    def score(self) -> float:
        """Cost and, well above what any gain in cost can outweigh, the violation."""
        return self.cost + 10.0 * self.violation


class Search:
    """One tuning: builds, judges and counts candidates; `trials` are those that could be built."""

    def __init__(
        self,
        family: Family,
        plants: Sequence[Any],
        specification: Specification,
        pull: float = PULL,
        scope: Scope = ONE_AXIS,
    ) -> None:
        """Begin a tuning, with no candidate judged yet.

        Args:
            family: Kind of controller.
            plants: The nominal plant first, then others that it could also be.
            specification: Modulus margin and bandwidth that every plant has to have.
            pull: Share of the rms that the most vigorous value of a parameter counts for, see `PULL`; 0 for none.
            scope: What the plants and the family's controllers are.

        Raises:
            ValueError: The plants do not fit together, or the family has no controller for the nominal one.
        """
        self.family, self.plants, self.specification = family, plants, specification
        self.parameters = family.parameters(plants[0]) if plants else ()
        self.judge, self._scope = scope.judge(plants), scope
        self.trials: list[Trial] = []
        self.count = 0
        self.optimism = 1.0  # by how much the grid has been seen to overstate the modulus margin
        self.reason: ValueError | None = None
        self._looked: dict[bytes, list[Margins]] = {}
        self._gentle = np.array([0.0 if p.gentle is None else place_of(p, p.gentle) for p in self.parameters])
        self._pull = pull

    def at(self, place: Floats) -> Trial:
        """Judge the candidate at a place, its coordinates clipped to the bounds."""
        (found,) = self.at_all([place])
        return found

    def at_all(self, places: Sequence[Floats]) -> list[Trial]:
        """Judge the candidates at many places at once, as `at` does."""
        within = [np.clip(place, 0.0, 1.0) for place in places]
        values = [np.array([value(p, x) for p, x in zip(self.parameters, place, strict=True)]) for place in within]
        return self.of_all(values, within)

    def of(self, values: Floats, place: Floats | None = None) -> Trial:
        """Judge the candidate of these values; one that cannot be built counts as unstable.

        Args:
            values: Values of the parameters in SI units, shape (parameters,).
            place: Their place within the bounds, shape (parameters,), each from 0 to 1; found from the values if not
                given.
        """
        (found,) = self.of_all([values], None if place is None else [place])
        return found

    def of_all(self, values: Sequence[Floats], places: Sequence[Floats] | None = None) -> list[Trial]:
        """Judge the candidates of many values at once, as `of` does.

        Args:
            values: Values of the parameters of each candidate in SI units, each of shape (parameters,).
            places: Their places within the bounds, in the same order; found from the values if not given.
        """
        if places is None:
            own = [zip(self.parameters, each, strict=True) for each in values]
            places = [np.array([place_of(p, v) for p, v in pairs]) for pairs in own]
        built = [self._built(each) for each in values]
        verdicts = iter(self.judge.several([controller for controller in built if controller is not None]))
        trials = [
            self._trial(place, each, self.judge.unstable(math.inf) if controller is None else next(verdicts))
            for place, each, controller in zip(places, values, built, strict=True)
        ]
        self.trials += [trial for trial in trials if math.isfinite(trial.verdict.pole)]
        self.count += len(trials)
        return trials

    def _built(self, values: Floats) -> Any:
        """The controller of these values; None, and the first reason kept, where it cannot be built."""
        try:
            controller = self.family.build(self.plants[0], values)
            self._scope.misfit(self.plants[0], controller)
        except ValueError as error:
            self.reason = self.reason or error
            return None
        return controller

    def margins(self, trial: Trial) -> list[Margins]:
        """Margins of a stable trial on all plants, looked at closely; once for each."""
        key = trial.values.tobytes()
        if key not in self._looked:
            controller = self.family.build(self.plants[0], trial.values)
            self._looked[key] = [self._scope.margins(p, controller) for p in self.plants]
        return self._looked[key]

    def _trial(self, place: Floats, values: Floats, verdict: Verdict) -> Trial:
        asked = self.specification
        ceiling = 0.5 * math.log(self.judge.open_rad2) + 1.0
        beyond = min(verdict.pole - 1.0, 1.0) if verdict.pole >= 1.0 else 0.0
        cost = ceiling + beyond if verdict.pole >= 1.0 else min(0.5 * math.log(verdict.mean_rad2), ceiling)
        margin = asked.modulus_margin * self.optimism * (1.0 + HEADROOM)
        excess = (verdict.moduli - margin) / max(asked.modulus_margin, 0.1) - beyond
        if asked.bandwidth_hz > 0.0:
            reached = verdict.bandwidths_hz / asked.bandwidth_hz / (1.0 + HEADROOM)
            excess = np.append(excess, np.log(np.maximum(reached, 0.1)) - beyond)
        return Trial(place, values, verdict, cost + self._pull * float(np.sum((place - self._gentle) ** 2)), excess)


def value(parameter: Parameter, place: float) -> float:
    """Value of a parameter at a place within its bounds, on its own scale (linear or logarithmic).

    Args:
        parameter: The parameter.
        place: From 0 (its least value) to 1 (its most).
    """
    if parameter.log:
        return float(parameter.least * (parameter.most / parameter.least) ** place)
    return float(parameter.least + place * (parameter.most - parameter.least))


def place_of(parameter: Parameter, number: float) -> float:
    """Place of a value within the bounds of its parameter, the reverse of `value`; 0 below the least.

    Args:
        parameter: The parameter.
        number: Its value, in the parameter's unit.
    """
    if number <= parameter.least:
        return 0.0
    if parameter.log:
        return math.log(number / parameter.least) / math.log(parameter.most / parameter.least)
    return (number - parameter.least) / (parameter.most - parameter.least)


def rounded(number: float) -> float:
    """The number to four significant digits, as tuned values are used: what is printed is what runs."""
    return float(f"{number:.3e}")


def apart(trials: Sequence[Trial], most: int, distance: float) -> list[Trial]:
    """The first trials that lie apart from each other.

    Args:
        trials: Trials in the order in which they are preferred.
        most: How many are taken at most.
        distance: Share of the bounds that any two of them differ by, or more, in one parameter at least.
    """
    found: list[Trial] = []
    for t in trials:
        if len(found) < most and all(np.max(np.abs(t.place - other.place), initial=0.0) > distance for other in found):
            found.append(t)
    return found
