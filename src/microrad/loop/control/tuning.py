"""Tuning: the parameters of a family of controllers that leave the least residual, under a margin, on every plant."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from microrad.core.arrays import Floats
from microrad.core.progress import Progress
from microrad.core.units import plain
from microrad.loop.control.analysis import LoopMargins, close, h2, loop_margins
from microrad.loop.control.descent import MODELS, descend, settle
from microrad.loop.control.problem import RESIDUAL, AxisController, DesignPlant, Family, Specification
from microrad.loop.control.search import HEADROOM, Search, Trial, apart, rounded

MARGIN, BANDWIDTH = "modulus margin", "bandwidth"
"""What a tuned design can be bound by, beside the bounds of its parameters."""

CLOSE_LOOKS = 30
"""Trials whose margins are looked at closely before the specification is called out of reach."""

OVERSTATED = 4
"""Times that an optimum is sought with a stricter margin, where its grid has missed a narrow dip of |1 + L|."""

SURVEY = 100
"""Places of the Latin hypercube that a search begins with."""

STARTS, AGREE = 8, 3
"""Places that a local search sets out from, as a family may have several optima; no more once so many of them have led
to the best of them."""

FINALISTS = 3
"""Optima that are followed to their last digit."""

CLOSE = 1e-4
"""Excess of cost over the best from which an optimum is not followed: a rough search ends within some 1e-5 of one."""

SAME_COST = 6
"""Decimals of the cost to which two optima are as good as each other: then the smaller values are taken."""


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


def tune(
    family: Family,
    plants: Sequence[DesignPlant],
    specification: Specification,
    *,
    seed: int,
    on_progress: Progress = lambda done, total, what: None,
    survey: int = SURVEY,
    base: Tuned | None = None,
) -> Tuned:
    """Find the controller of a family that leaves the least mean variance over all plants.

    It is built for the first plant. Every plant has to be stable with it, have the modulus margin, cut at the command
    and at the optical sensor, and the bandwidth that is asked for. A Latin hypercube of places is looked at first, then
    local searches set out from its best places and, where the family contains another, from that one's optimum: the
    result is never worse than that. The best optima are followed until they stand still; the values are used to four
    significant digits.

    Args:
        family: Kind of controller.
        plants: The nominal plant first, then others that it could also be.
        specification: Modulus margin and bandwidth that every plant has to have.
        seed: Seed of the places that are looked at first.
        on_progress: Called with the places and local searches that are done, their number and what is done.
        survey: Number of the places that are looked at first.
        base: Optimum of the family that this one contains, where it is known.

    Raises:
        ValueError: The family has no controller for the nominal plant, none was stable on every plant, or the
            specification is not met; says what the best one reaches.
    """
    total, what = survey + STARTS + FINALISTS, f"tune {family.name}"
    search = Search(family, plants, specification)
    contained = _contained(search, seed, survey, base)
    surveyed = search.at_all(list(_places(search, contained, survey, seed)))
    on_progress(survey, total, what)
    if not search.trials:
        raise ValueError(_no_stable(search))
    rough = []
    halves = sorted(surveyed[::2], key=_score), sorted(surveyed[1::2], key=_score)
    best = [trial for pair in zip(*halves, strict=False) for trial in pair]
    for start in [*contained, *apart(best, STARTS - len(contained), 0.1)]:
        rough.append(descend(search, start))
        on_progress(survey + len(rough), total, what)
        if sum(t.score < min(map(_score, rough)) + 0.1 * CLOSE for t in rough) >= AGREE:
            break
    finalists = apart(sorted(rough, key=_score), FINALISTS, 0.02)
    found = _tuned(search, settled(search, [t for t in finalists if t.score < finalists[0].score + CLOSE]))
    better = [
        t for t in contained if t.verdict.pole < 1.0 and _mean_rms_rad(_variances(search, t)[1]) < found.mean_rms_rad
    ]
    inner = [_tuned(search, t) for t in better if _holds(search, t)]
    on_progress(total, total, what)
    return min([found, *inner], key=lambda t: t.mean_rms_rad)


def _contained(search: Search, seed: int, survey: int, base: Tuned | None) -> list[Trial]:
    """The optimum of the family that this one contains; none where it contains no other or that one has none."""
    inner, extended = search.family.base, search.family.extended
    if inner is None or extended is None:
        return []
    try:
        known = base or tune(inner, search.plants, search.specification, seed=seed, survey=survey)
    except ValueError:
        return []
    values = extended(search.plants[0], np.array(list(known.values.values())))
    return [search.of(np.array([rounded(v) for v in values]))]


def _places(search: Search, contained: Sequence[Trial], survey: int, seed: int) -> Floats:
    """Where a search looks first; half of it beside what it contains, with that one's values and any of its own."""
    found = hypercube(len(search.parameters), survey, seed)
    if contained and search.family.base:
        shared = len(search.family.base.parameters(search.plants[0]))
        found[::2, :shared] = contained[0].place[:shared]
    return found


def hypercube(dimensions: int, count: int, seed: int) -> Floats:
    """Places (count, dimensions) of a Latin hypercube, each coordinate from 0 to 1.

    Args:
        dimensions: Number of coordinates.
        count: Number of places.
        seed: Seed of the places.
    """
    rng = np.random.Generator(np.random.Philox(seed))
    strata = np.array([rng.permutation(count) for _ in range(dimensions)]).reshape(dimensions, count).T
    return np.asarray((strata + rng.random((count, dimensions))) / count)


def _score(trial: Trial) -> float:
    return trial.score


def settled(search: Search, optima: Sequence[Trial], models: int = MODELS) -> Trial:
    """The best of some optima, followed to its last digit and its values rounded.

    Args:
        search: Judges the candidates.
        optima: Trials near optima.
        models: Most quadratic models on the way to the last digit, see `settle`.

    Raises:
        ValueError: It does not keep the specification.
    """
    for _ in range(OVERSTATED):
        optima = [settle(search, t, models) for t in optima]
        best = min(optima, key=lambda t: (round(t.score, SAME_COST), *t.values))
        found = search.of(np.array([rounded(v) for v in best.values]), best.place)
        if _holds(search, found):
            return found
        search.optimism = max(search.optimism, _overstated(search, found)) * (1.0 + HEADROOM)
        optima = [search.at(t.place) for t in optima]  # by what the margin is now taken to need
    raise ValueError(_refusal(search))


def grid_best(
    family: Family, plants: Sequence[DesignPlant], specification: Specification, grid: Sequence[Sequence[float]]
) -> Tuned:
    """The best controller of an explicit grid; as `tune` for everything else.

    Args:
        family: Kind of controller.
        plants: The nominal plant first, then others that it could also be.
        specification: Modulus margin and bandwidth that every plant has to have.
        grid: Values of each parameter in SI units, in the order of the family's parameters.

    Raises:
        ValueError: The grid has not one row of values for each parameter, or no controller of the grid meets the
            specification.
    """
    search = Search(family, plants, specification, pull=0.0)
    if len(grid) != len(search.parameters):
        names = ", ".join(p.name for p in search.parameters)
        raise ValueError(
            f"{len(grid)} rows of values for the parameters of {family.name} ({names}): give each one its row"
        )
    search.of_all([np.array(values, dtype=float) for values in product(*grid)])
    return _chosen(search)


def _candidates(search: Search) -> list[Trial]:
    """Trials that meet the specification as far as the grid can tell, the cheapest first."""
    asked = search.specification
    met = (
        t
        for t in search.trials
        if t.verdict.pole < 1.0
        and t.modulus >= asked.modulus_margin
        and np.min(t.verdict.bandwidths_hz) >= asked.bandwidth_hz
    )
    return sorted(met, key=lambda t: t.cost)


def _holds(search: Search, trial: Trial) -> bool:
    """Whether a trial keeps the specification when its margins are looked at closely."""
    asked = search.specification
    return trial.verdict.pole < 1.0 and all(
        m.modulus >= asked.modulus_margin and m.bandwidth_hz >= asked.bandwidth_hz for m in search.margins(trial)
    )


def _overstated(search: Search, trial: Trial) -> float:
    """By how much the search has overstated a trial's modulus margin, 1 for one that is unstable."""
    if trial.verdict.pole >= 1.0:
        return 1.0
    return trial.modulus / min(m.modulus for m in search.margins(trial))


def _chosen(search: Search) -> Tuned:
    """The cheapest trial that holds when its margins are looked at closely. Raises ValueError where none does."""
    for trial in _candidates(search)[:CLOSE_LOOKS]:
        if _holds(search, trial):
            return _tuned(search, trial)
    raise ValueError(_refusal(search))


def _variances(search: Search, trial: Trial) -> tuple[AxisController, list[float]]:
    """The controller of a trial as it is used, and the variance of its residual (rad^2) on each plant."""
    controller = (search.family.final or search.family.build)(search.plants[0], trial.values)
    return controller, [float(np.sum(h2(close(p, controller))[RESIDUAL])) for p in search.plants]


def _mean_rms_rad(variances: Sequence[float]) -> float:
    return math.sqrt(float(np.mean(variances)))


def _tuned(search: Search, trial: Trial) -> Tuned:
    controller, variances = _variances(search, trial)
    margins = [loop_margins(p, controller) for p in search.plants]
    evaluations = search.count
    modulus, bandwidth = min(m.modulus for m in margins), min(m.bandwidth_hz for m in margins)
    asked = search.specification
    bound = [MARGIN] if modulus <= 1.01 * asked.modulus_margin else []
    bound += [BANDWIDTH] if 0.0 < asked.bandwidth_hz >= bandwidth / 1.01 else []
    for i, p in enumerate(search.parameters):
        bound += [f"{p.name} at its {side}" for side in _pressed(search, trial, i)]
    return Tuned(
        controller=controller,
        values=_named(search, trial),
        residual_rms_rad=math.sqrt(variances[0]),
        mean_rms_rad=_mean_rms_rad(variances),
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
    return ", ".join(f"{p.name} {plain(v, 4)} {p.unit}".rstrip() for p, v in named)


def _everywhere(search: Search) -> str:
    return f" on all {len(search.plants)} plants" if len(search.plants) > 1 else ""


def _refusal(search: Search) -> str:
    stable = [t for t in search.trials if t.verdict.pole < 1.0]
    return _out_of_reach(search, min(stable, key=lambda t: (t.violation, t.cost))) if stable else _no_stable(search)


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
    margins = search.margins(best)
    bandwidth = f" and a bandwidth of {asked.bandwidth_hz:g} Hz" if asked.bandwidth_hz else ""
    reached = f" and {min(m.bandwidth_hz for m in margins):.4g} Hz" if asked.bandwidth_hz else ""
    return (
        f"no {search.family.name} of {search.count} tried meets the specification{_everywhere(search)}: "
        f"a modulus margin of {asked.modulus_margin:g}{bandwidth} is asked for, the nearest reaches "
        f"{min(m.modulus for m in margins):.3g}{reached} with {_with(search, best)}; ask for less, shorten the delay, "
        "or take another controller"
    )
