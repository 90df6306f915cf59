"""Tuning: the parameters of a family of controllers that leave the least residual, under a margin, on every plant."""

import contextlib
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray

from microrad.control.analysis import LoopMargins, close, h2, loop_margins, refuse_misfit
from microrad.control.judge import Judge, Verdict
from microrad.control.problem import RESIDUAL, AxisController, DesignPlant, Family, Parameter, Specification

Floats = NDArray[np.float64]
Progress = Callable[[int, int, str], None]

MARGIN, BANDWIDTH = "modulus margin", "bandwidth"
"""What a tuned design can be bound by, beside the bounds of its parameters."""

CLOSE_LOOKS = 30
"""Trials whose margins are looked at closely before the specification is called out of reach."""

OVERSTATED = 4
"""Times that the search goes on with a stricter margin where its grid has missed a narrow dip of |1 + L|."""

STARTS = 8
"""Places that a local search sets out from: a family may have several optima."""

STEP = 1e-4
"""Step of the differences, over a parameter's range."""

HEADROOM = 1e-3
"""Relative excess over what is asked for that the search aims at: its grid may miss the least by a little."""


@dataclass(frozen=True, slots=True)
class Tuned:
    """A controller and what it was chosen for.

    ``values`` are its parameters by name. ``residual_rms_rad`` and ``margins`` belong to the nominal plant; ``mean`` is
    the root of the mean variance over all plants and ``worst`` the largest rms. ``least_modulus`` and
    ``least_bandwidth_hz`` are the smallest over all plants. ``bound_by`` names what keeps the residual from being
    smaller: `MARGIN`, `BANDWIDTH`, or a parameter "at its least" or "at its most"; empty inside all bounds.
    """

    controller: AxisController
    values: dict[str, float]
    residual_rms_rad: float
    mean_rms_rad: float
    worst_rms_rad: float
    margins: LoopMargins
    least_modulus: float
    least_bandwidth_hz: float
    evaluations: int
    bound_by: tuple[str, ...]


# ------------------------------------------------------------------------------------------------ search


@dataclass(frozen=True, slots=True, eq=False)
class Trial:
    """One candidate: its place within the bounds (each coordinate in 0..1), what it reaches and by what it falls short.

    ``excess`` is relative to what is asked for, one number for each constraint, below 0 where it is not met.
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
        self, family: Family, plants: Sequence[DesignPlant], specification: Specification, report: Callable[[int], None]
    ) -> None:
        """Raise ValueError where the plants do not fit together or the family has no controller for the nominal one."""
        self.family, self.plants, self.specification = family, plants, specification
        self.parameters = family.parameters(plants[0]) if plants else ()
        self.judge = Judge(plants)
        self.trials: list[Trial] = []
        self.looked_at: dict[Trial, tuple[AxisController, list[LoopMargins]]] = {}
        self.count = 0
        self.optimism = 1.0  # by how much the grid has been seen to overstate the modulus margin
        self.reason: ValueError | None = None
        self._report = report

    def at(self, place: Floats) -> Trial:
        """Judge the candidate at a place, its coordinates clipped to the bounds."""
        place = np.clip(place, 0.0, 1.0)
        return self.of(np.array([value(p, x) for p, x in zip(self.parameters, place, strict=True)]), place)

    def of(self, values: Floats, place: Floats) -> Trial:
        """Judge the candidate of these values; one that cannot be built counts as unstable."""
        try:
            controller = self.family.build(self.plants[0], values)
            refuse_misfit(self.plants[0], controller)
        except ValueError as error:
            self.reason = self.reason or error
            verdict = self.judge.unstable(math.inf)
        else:
            verdict = self.judge(controller)
        trial = self._trial(place, values, verdict)
        if math.isfinite(verdict.pole):
            self.trials.append(trial)
        self.count += 1
        self._report(self.count)
        return trial

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
        return Trial(place, values, verdict, cost, excess)


def value(parameter: Parameter, place: float) -> float:
    """Value of a parameter at a place from 0 (its least) to 1 (its most), on its own scale."""
    if parameter.log:
        return float(parameter.least * (parameter.most / parameter.least) ** place)
    return float(parameter.least + place * (parameter.most - parameter.least))


def place_of(parameter: Parameter, number: float) -> float:
    """The reverse of `value`; 0 below the least."""
    if number <= parameter.least:
        return 0.0
    if parameter.log:
        return math.log(number / parameter.least) / math.log(parameter.most / parameter.least)
    return (number - parameter.least) / (parameter.most - parameter.least)


def tune(
    family: Family,
    plants: Sequence[DesignPlant],
    specification: Specification,
    *,
    seed: int,
    on_progress: Progress = lambda done, total, what: None,
    evaluations: int = 1000,
) -> Tuned:
    """The controller of a family, built for the first plant, that leaves the least mean variance over all plants.

    Every plant has to be stable with it, have the modulus margin, cut at the command and at the optical sensor, and the
    bandwidth that ``specification`` asks for. The first plant is the nominal one, the others are what it could also be.
    A Latin hypercube drawn from ``seed``, then sequential quadratic programming under constraints from its best places
    (SLSQP: Kraft, DFVLR-FB 88-28, 1988), ``evaluations`` at most. ``on_progress(done, total, what)`` counts them.

    Raises ValueError where the family has no controller for the nominal plant, none was stable on every plant, or the
    specification is not met, with the best that was reached.
    """
    what = f"tune {family.name}"
    search = Search(family, plants, specification, lambda n: on_progress(min(n, evaluations), evaluations, what))
    d = len(search.parameters)
    first = max(int(0.3 * evaluations), 1)
    rng = np.random.Generator(np.random.Philox(seed))
    strata = np.array([rng.permutation(first) for _ in range(d)]).reshape(d, first).T
    starts = sorted((search.at(place) for place in (strata + rng.random((first, d))) / first), key=lambda t: t.score)
    for start in _apart(starts, STARTS):
        _polish(search, start, int(0.9 * evaluations))
    for _ in range(OVERSTATED):
        best = _overstated(search)
        if best is None:
            break
        _polish(search, best, min(search.count + 12 * d, evaluations))
    on_progress(evaluations, evaluations, what)
    return _chosen(search)


def grid_best(
    family: Family, plants: Sequence[DesignPlant], specification: Specification, grid: Sequence[Sequence[float]]
) -> Tuned:
    """The best controller of an explicit grid, one row of values for each parameter; as `tune` for everything else."""
    search = Search(family, plants, specification, lambda n: None)
    if len(grid) != len(search.parameters):
        names = ", ".join(p.name for p in search.parameters)
        raise ValueError(
            f"{len(grid)} rows of values for the parameters of {family.name} ({names}): give each one its row"
        )
    for values in product(*grid):
        place = np.array([place_of(p, v) for p, v in zip(search.parameters, values, strict=True)])
        search.of(np.array(values, dtype=float), place)
    return _chosen(search)


def _apart(trials: Sequence[Trial], most: int) -> list[Trial]:
    """The first trials that lie at least a tenth of the bounds apart from each other."""
    found: list[Trial] = []
    for t in trials:
        if len(found) < most and all(np.max(np.abs(t.place - other.place)) > 0.1 for other in found):
            found.append(t)
    return found


class _SpentError(Exception):
    """No evaluation is left."""


class _Local:
    """Cost and constraints around one trial, with derivatives by differences; each place is judged once."""

    def __init__(self, search: Search, evaluations: int) -> None:
        self._search, self._evaluations = search, evaluations
        self._known: dict[bytes, Trial] = {}
        self._slopes: dict[bytes, tuple[Floats, Floats]] = {}

    def at(self, place: Floats) -> Trial:
        key = place.tobytes()
        if key not in self._known:
            if self._search.count >= self._evaluations:
                raise _SpentError
            self._known[key] = self._search.at(place)
        return self._known[key]

    def slopes(self, place: Floats) -> tuple[Floats, Floats]:
        """Gradient of the cost and of each constraint, by a step into the bounds."""
        key = place.tobytes()
        if key not in self._slopes:
            here, rows = self.at(place), []
            for i in range(place.size):
                step = np.zeros(place.size)
                step[i] = STEP if place[i] < 0.5 else -STEP
                there = self.at(np.clip(place, 0.0, 1.0) + step)
                rows.append(np.append(there.cost - here.cost, there.excess - here.excess) / step[i])
            self._slopes[key] = np.array(rows)[:, 0], np.array(rows)[:, 1:].T
        return self._slopes[key]


def _polish(search: Search, start: Trial, evaluations: int) -> None:
    """Local search from one trial, as long as the search has evaluations left; what it finds is among the trials."""
    from scipy.optimize import minimize  # slow to import, not needed to show help

    if not start.place.size:
        return
    local, eye = _Local(search, evaluations), np.eye(start.place.size)
    inside = {
        "type": "ineq",
        "fun": lambda x: np.concatenate([local.at(x).excess, x, 1.0 - x]),
        "jac": lambda x: np.vstack([local.slopes(x)[1], eye, -eye]),
    }
    with contextlib.suppress(_SpentError):
        minimize(
            lambda x: local.at(x).cost,
            start.place,
            jac=lambda x: local.slopes(x)[0].copy(),  # SLSQP writes into it
            method="SLSQP",
            constraints=[inside],
            options={"maxiter": 20, "ftol": 1e-6},
        )


def _candidates(search: Search) -> list[Trial]:
    """Trials that meet the specification as far as the grid can tell, the cheapest first."""
    asked = search.specification
    least = asked.modulus_margin * search.optimism
    met = (
        t
        for t in search.trials
        if t.verdict.pole < 1.0 and t.modulus >= least and np.min(t.verdict.bandwidths_hz) >= asked.bandwidth_hz
    )
    return sorted(met, key=lambda t: t.cost)


def _closely(search: Search, trial: Trial) -> tuple[AxisController, list[LoopMargins]]:
    if trial not in search.looked_at:
        controller = search.family.build(search.plants[0], trial.values)
        search.looked_at[trial] = controller, [loop_margins(p, controller) for p in search.plants]
    controller, margins = search.looked_at[trial]
    search.optimism = max(search.optimism, trial.modulus / min(m.modulus for m in margins))
    return controller, margins


def _overstated(search: Search) -> Trial | None:
    """The cheapest trial, if it does not hold when its margins are looked at closely."""
    best = next(iter(_candidates(search)), None)
    if best is None or _holds(_closely(search, best)[1], search.specification):
        return None
    return best


def _chosen(search: Search) -> Tuned:
    """The cheapest trial that holds when its margins are looked at closely. Raises ValueError where none does."""
    stable = [t for t in search.trials if t.verdict.pole < 1.0]
    if not stable:
        raise ValueError(_no_stable(search))
    for _ in range(CLOSE_LOOKS):
        best = next(iter(_candidates(search)), None)
        if best is None:
            break
        controller, margins = _closely(search, best)
        if _holds(margins, search.specification):
            return _tuned(search, best, controller, margins)
        search.trials.remove(best)
    raise ValueError(_out_of_reach(search, min(stable, key=lambda t: (t.violation, t.cost))))


def _holds(margins: Sequence[LoopMargins], asked: Specification) -> bool:
    return all(m.modulus >= asked.modulus_margin and m.bandwidth_hz >= asked.bandwidth_hz for m in margins)


def _tuned(search: Search, trial: Trial, controller: AxisController, margins: Sequence[LoopMargins]) -> Tuned:
    variances = [float(np.sum(h2(close(p, controller))[RESIDUAL])) for p in search.plants]
    evaluations = search.count
    modulus, bandwidth = min(m.modulus for m in margins), min(m.bandwidth_hz for m in margins)
    asked = search.specification
    bound = [MARGIN] if modulus <= 1.01 * asked.modulus_margin else []
    bound += [BANDWIDTH] if bandwidth <= 1.01 * asked.bandwidth_hz else []
    for i, p in enumerate(search.parameters):
        bound += [f"{p.name} at its {side}" for side in _pressed(search, trial, i)]
    return Tuned(
        controller=controller,
        values=_named(search, trial),
        residual_rms_rad=math.sqrt(variances[0]),
        mean_rms_rad=math.sqrt(float(np.mean(variances))),
        worst_rms_rad=math.sqrt(max(variances)),
        margins=margins[0],
        least_modulus=modulus,
        least_bandwidth_hz=bandwidth,
        evaluations=evaluations,
        bound_by=tuple(bound),
    )


def _pressed(search: Search, trial: Trial, index: int) -> list[str]:
    """The bound of a parameter that a trial is pressed against: a step away from it costs, or breaks a constraint."""
    x = trial.place[index]
    if 1e-3 <= x <= 1.0 - 1e-3:
        return []
    away = trial.place.copy()
    away[index] = abs(x - 0.05)
    return ["least" if x < 0.5 else "most"] if search.at(away).score > trial.cost + 1e-3 else []


def _named(search: Search, trial: Trial) -> dict[str, float]:
    return {p.name: float(v) for p, v in zip(search.parameters, trial.values, strict=True)}


def _with(search: Search, trial: Trial) -> str:
    named = zip(search.parameters, trial.values, strict=True)
    return ", ".join(f"{p.name} {v:.4g} {p.unit}".rstrip() for p, v in named)


def _everywhere(search: Search) -> str:
    return f" on all {len(search.plants)} plants" if len(search.plants) > 1 else ""


def _no_stable(search: Search) -> str:
    if not search.trials:
        return f"no {search.family.name} could be built in {search.count} tries; the first was refused: {search.reason}"
    nearest = min(search.trials, key=lambda t: t.verdict.pole)
    return (
        f"no {search.family.name} of {search.count} tried is stable{_everywhere(search)}: the nearest "
        f"has a pole at |z| = {nearest.verdict.pole:.6f} (the limit is 1) with {_with(search, nearest)}; shorten the "
        "delay, narrow what is unknown of the plant, or take another controller"
    )


def _out_of_reach(search: Search, best: Trial) -> str:
    asked = search.specification
    margins = [loop_margins(p, search.family.build(search.plants[0], best.values)) for p in search.plants]
    bandwidth = f" and a bandwidth of {asked.bandwidth_hz:g} Hz" if asked.bandwidth_hz else ""
    reached = f" and {min(m.bandwidth_hz for m in margins):.4g} Hz" if asked.bandwidth_hz else ""
    return (
        f"no {search.family.name} of {search.count} tried meets the specification{_everywhere(search)}: "
        f"a modulus margin of {asked.modulus_margin:g}{bandwidth} is asked for, the nearest reaches "
        f"{min(m.modulus for m in margins):.3g}{reached} with {_with(search, best)}; ask for less, shorten the delay, "
        "or take another controller"
    )
