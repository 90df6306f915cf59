"""Optimisation: the design variables that cost least while each limit is kept by a wanted share of the rows.

The wanted probability is asked of the same drawn rows for every candidate (sample average approximation: Luedtke and
Ahmed, SIAM J. Optim. 19, 2008, 674-699). The search looks at the value in the row that decides a limit (candidates.py).
That quantile is continuous in the variables, and on the right side of the limit exactly where the share is large
enough. An optimum leans on its own rows, so it is judged once more on fresh ones.

The search is COBYQA (Ragonneau, Model-based derivative-free optimization methods and software, Hong Kong Polytechnic
University, 2022; in scipy), from several places of a Latin hypercube. It never leaves the bounds, takes constraints,
and needs no slopes: the quantile has kinks, and a controller tuned anew is rough. On five problems of one to four
variables with known optima (two wells of which the narrower is deeper, Gomez and Levy's disjoint regions, Rosen and
Suzuki's, and two links), with 200 evaluations and ten seeds each, it came within 1 % of the cost's range of the
optimum in 50 of 50; so did SLSQP from the same places, COBYLA in 45, differential evolution in 33. With a roughness of
0.1 % on three of them COBYQA did in 30 of 30, COBYLA in 26, differential evolution in 15, SLSQP in 8.

Variables take values of four significant digits, and the search is told of costs and constraints to `DECIMALS`: what
another processor rounds otherwise is below both, so that it looks at the same candidates and ends at the same one,
unless a number lies within some 1e-12 of where its digits turn.
"""

import contextlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from microrad.campaign.optimisation.candidates import Candidate, Problem, judged, percent, quantity_text
from microrad.campaign.records import CampaignError
from microrad.core.arrays import Floats
from microrad.core.progress import Progress
from microrad.core.units import counted
from microrad.loop import control

Evaluate = Callable[[Floats], dict[str, Floats]]

FIRST_LOOK = 0.25
"""Share of the evaluations that is spread over the whole range before the searches set out."""

APART = 0.15
"""Least distance of two places that searches set out from, over the diagonal of the unit cube."""

SEARCHED = 0.6
"""Share of the evaluations after which no further search sets out; the rest refines what is best."""

COARSE = (0.1, 0.03)
"""Trust region of a search at first and at last, over a variable's range."""

REFINED = ((0.05, 1e-4), (0.02, 1e-5))
"""Likewise of the searches from the best candidate: a new one gets off a kink that stopped the one before."""

HEADROOM = 1e-4
"""How far inside a limit the search aims, over the constraint's scale: its answers miss a little."""

ACTIVE = 0.02
"""A limit that the optimum is nearer to than this, over the constraint's scale, is active; likewise a bound."""

VIOLATION_COUNTS = 10.0
"""Cost, over its scale, of missing a limit by its scale: orders candidates of which some miss one."""

DECIMALS = 9
"""Decimals of scaled costs and constraints that the search is told."""

FARTHEST = 10.0
"""Scaled costs and constraints are cut off here: what lies beyond is infinite or might as well be."""


@dataclass(frozen=True, slots=True)
class Optimum:
    """The best candidate, what binds it, and how it does on fresh rows.

    Without a feasible candidate ``best`` is that which misses the limits least (None where none was a mission),
    ``reason`` says what cannot be kept, and ``fresh`` is None. ``bound_by`` names the limits and the bounds of
    variables that keep the cost from being lower. ``refused`` candidates were no mission. ``trace`` has all in their
    order.
    """

    problem: Problem
    best: Candidate | None
    fresh: Candidate | None
    bound_by: tuple[str, ...]
    evaluations: int
    refused: int
    reason: str
    warnings: tuple[str, ...]
    trace: tuple[Candidate, ...]

    @property
    def feasible(self) -> bool:
        """Whether a candidate keeps all limits on the rows of the search."""
        return self.best is not None and self.best.feasible

    @property
    def confirmed(self) -> bool:
        """Whether fresh rows agree: the interval of each share of them that keeps a limit reaches the wanted one.

        Not whether the shares themselves do: those of an optimum on a limit fall short of it as often as not.
        """
        fresh = self.fresh
        return fresh is not None and not fresh.refused and all(k.agrees(self.problem.confidence) for k in fresh.kept)


def optimise(problem: Problem, evaluate: Evaluate, evaluate_fresh: Evaluate, on_progress: Progress) -> Optimum:
    """The candidate of least cost whose rows keep each limit often enough; the same for the same seed.

    Raises `CampaignError` for a problem that cannot be searched.

    Args:
        problem: what to minimise, over which variables and under which limits.
        evaluate: from the variables' SI values (variables,) in their order to the columns of the outputs (rows,),
            nan in failed rows, for the same draws at every call, with a column ``weight`` where rows do not count
            alike; `CampaignError` from it refuses the candidate.
        evaluate_fresh: the same for other draws.
        on_progress: gets the candidates done, the most there may be, and the best cost so far in words.
    """
    _check(problem)
    search = _Search(problem, evaluate, on_progress)
    with contextlib.suppress(_SpentError):
        search.look_around()
        search.explore()
        search.refine()
    return _optimum(search, evaluate_fresh)


# ------------------------------------------------------------------------------------------------------------ searching
class _SpentError(Exception):
    """The evaluations are used up."""


@dataclass
class _Search:
    """Candidates by their place in the unit cube, in the order in which they were looked at."""

    problem: Problem
    evaluate: Evaluate
    report: Progress
    known: dict[bytes, tuple[Floats, Candidate]] = field(default_factory=dict)
    cost_scale: float = 1.0
    scales: Floats = field(default_factory=lambda: np.ones(0))

    def at(self, place: Floats) -> Candidate:
        """The candidate at a place; raises `_SpentError` where that is one too many."""
        place = np.clip(place, 0.0, 1.0)
        values = tuple(control.rounded(v.at(x)) for v, x in zip(self.problem.variables, place, strict=True))
        key = np.array(values).tobytes()
        if key not in self.known:
            if len(self.known) >= self.problem.evaluations:
                raise _SpentError
            self.known[key] = place, self._look(values)
            self.report(len(self.known), self.problem.evaluations, self._so_far())
        return self.known[key][1]

    def _look(self, numbers: tuple[float, ...]) -> Candidate:
        values = {v.key: x for v, x in zip(self.problem.variables, numbers, strict=True)}
        try:
            columns = self.evaluate(np.array(numbers))
        except CampaignError as error:
            return Candidate(values, float("nan"), (), str(error) or "refused")
        return judged(self.problem, values, columns)

    def _so_far(self) -> str:
        best = self.best()
        if best is None or not best.feasible:
            return "no candidate keeps the limits yet"
        return f"best {self.problem.cost_name} {quantity_text(best.cost, self.problem.cost_unit)}"

    @property
    def trace(self) -> tuple[Candidate, ...]:
        """All candidates."""
        return tuple(candidate for _, candidate in self.known.values())

    @property
    def accepted(self) -> list[tuple[Floats, Candidate]]:
        """Places and candidates that are missions."""
        return [pair for pair in self.known.values() if not pair[1].refused]

    def best(self) -> Candidate | None:
        """The cheapest that keeps all limits, else that which misses them least."""
        return min((c for _, c in self.accepted), key=self._order, default=None)

    def _order(self, candidate: Candidate) -> tuple[float, float, float]:
        cost = self.problem.sign * candidate.cost
        if candidate.feasible:
            return 0.0, 0.0, cost
        return self.violation(candidate), -sum(k.share.value for k in candidate.kept), cost

    # ------------------------------------------------------------------------------------------------- as numbers
    def cost(self, candidate: Candidate) -> float:
        """Cost to be minimised, over its scale."""
        return float(np.clip(self.problem.sign * candidate.cost / self.cost_scale, -1e6, 1e6))

    def excess(self, candidate: Candidate) -> Floats:
        """How far the candidate is inside each limit, over the constraint's scale."""
        excess = np.array([k.excess for k in candidate.kept])
        return np.clip(excess / (self.scales if self.scales.size else 1.0), -FARTHEST, FARTHEST)

    def violation(self, candidate: Candidate) -> float:
        """By how much the limits are missed, all together."""
        return float(np.linalg.norm(np.minimum(self.excess(candidate), 0.0)))

    def score(self, candidate: Candidate) -> float:
        """Cost and, well above what any gain in cost outweighs, the violation."""
        return self.cost(candidate) + VIOLATION_COUNTS * self.violation(candidate)

    # ----------------------------------------------------------------------------------------------------- moving
    def look_around(self) -> None:
        """Candidates all over the range, and from them what is a large step in the cost and in each constraint."""
        from scipy.stats import qmc

        size = len(self.problem.variables)
        count = max(size + 2, round(FIRST_LOOK * self.problem.evaluations))
        for place in qmc.LatinHypercube(size, rng=np.random.default_rng(self.problem.seed)).random(count):
            self.at(place)
        seen = [candidate for _, candidate in self.accepted]
        self.cost_scale = _spread([c.cost for c in seen])
        bounds = [[bound for bound in (x.least, x.most) if bound is not None] for x in self.problem.limits]
        self.scales = np.array([_spread([c.kept[i].excess for c in seen], x) for i, x in enumerate(bounds)])

    def starts(self) -> list[Floats]:
        """Places to set out from, the most promising first, no two close together."""
        found: list[Floats] = []
        for place, _ in sorted(self.accepted, key=lambda pair: self.score(pair[1])):
            if all(_distance(place, other) > APART * np.sqrt(place.size) for other in found):
                found.append(place)
        return found

    def explore(self) -> None:
        """Search from one place after the other, as long as there are evaluations for it."""
        for start in self.starts():
            if len(self.known) < SEARCHED * self.problem.evaluations:
                self.descend(start, *COARSE)

    def refine(self) -> None:
        """Search on from the best candidate."""
        for first, last in REFINED:
            if self.accepted:
                self.descend(min(self.accepted, key=lambda pair: self._order(pair[1]))[0], first, last)

    def descend(self, start: Floats, first_radius: float, last_radius: float) -> None:
        """Search from one place; what it finds is among the candidates."""
        from scipy.optimize import Bounds, NonlinearConstraint, minimize

        minimize(
            lambda place: self._numbers(place)[0],
            start,
            method="COBYQA",
            bounds=Bounds(np.zeros(start.size), np.ones(start.size)),
            constraints=NonlinearConstraint(lambda place: self._numbers(place)[1:], 0.0, np.inf),
            options={"initial_tr_radius": first_radius, "final_tr_radius": last_radius},
        )

    def _numbers(self, place: Floats) -> Floats:
        """Cost and excesses; a refused candidate has its neighbour's, and is the worse the farther it is from it."""
        candidate, away = self.at(place), 0.0
        # not as a constraint of its own: that would be constant among the missions, which stops the search short
        if candidate.refused:
            neighbour, candidate = min(self.accepted, key=lambda pair: _distance(pair[0], place))
            away = _distance(neighbour, place)
        numbers = np.array(
            [self.cost(candidate) + VIOLATION_COUNTS * away, *(self.excess(candidate) - HEADROOM - away)]
        )
        return np.round(numbers, DECIMALS)


def _distance(place: Floats, other: Floats) -> float:
    return float(np.linalg.norm(place - other))


def _spread(numbers: list[float], bounds: Sequence[float] = ()) -> float:
    """Distance of the quartiles, or of the extremes where these agree; where all agree the largest size, or 1."""
    finite = np.array([x for x in numbers if np.isfinite(x)])
    for share in (0.25, 0.0):
        width = float(np.ptp(np.quantile(finite, [share, 1.0 - share]))) if finite.size else 0.0
        if width > 0.0:
            return width
    # not 1 at once: in SI units what no variable moves may be a millionth of it, and would look like being on the limit
    return max(map(abs, (*finite.tolist(), *bounds)), default=0.0) or 1.0


# ------------------------------------------------------------------------------------------------------------- the end
def _optimum(search: _Search, evaluate_fresh: Evaluate) -> Optimum:
    best, problem = search.best(), search.problem
    refused = [c for c in search.trace if c.refused]
    fresh, warnings = _on_fresh_rows(problem, best, evaluate_fresh)
    return Optimum(
        problem,
        best,
        fresh,
        () if best is None else _bound_by(search, best),
        len(search.known),
        len(refused),
        _reason(problem, best, refused),
        warnings,
        search.trace,
    )


def _on_fresh_rows(
    problem: Problem, best: Candidate | None, evaluate_fresh: Evaluate
) -> tuple[Candidate | None, tuple[str, ...]]:
    """The best candidate, if it is feasible, on other draws, and why it could not be drawn."""
    if best is None or not best.feasible:
        return None, ()
    try:
        columns = evaluate_fresh(np.array(list(best.values.values())))
    except CampaignError as error:
        return None, (f"the optimum could not be checked with fresh rows: {error}",)
    return judged(problem, best.values, columns), ()


def _bound_by(search: _Search, best: Candidate) -> tuple[str, ...]:
    """Limits and bounds that the best candidate is at; a limit that no candidate missed has kept it from nothing."""
    missed = {k.limit.output for _, c in search.accepted for k in c.kept if not k.holds}
    place = next(p for p, c in search.known.values() if c is best)
    variables = zip(search.problem.variables, place, strict=True)
    limits = zip(best.kept, search.excess(best), strict=True)
    return (
        *(k.limit.output for k, excess in limits if excess < ACTIVE and k.limit.output in missed),
        *(f"{v.key} at its {'low' if x < 0.5 else 'high'}" for v, x in variables if min(x, 1.0 - x) < ACTIVE),
    )


def _reason(problem: Problem, best: Candidate | None, refused: list[Candidate]) -> str:
    """Why there is no optimum; empty where there is one."""
    if best is None:
        return f"no candidate is a mission: all {len(refused)} were refused, the last because {refused[-1].refused}"
    missed = [k for k in best.kept if not k.holds]
    if not missed:
        return ""
    return (
        f"no candidate keeps {' and '.join(k.wanted for k in missed)} in {percent(problem.confidence)} of rows; "
        f"the best has {' and '.join(percent(k.share.value) for k in missed)}"
    )


def _check(problem: Problem) -> None:
    """Raises `CampaignError` if there are too few evaluations to search with."""
    least = 8 * (len(problem.variables) + 1)
    if problem.evaluations < least:
        raise CampaignError(
            f"optimise.evaluations: {problem.evaluations} are too few for "
            f"{counted(len(problem.variables), 'variable')}; give at least {least}"
        )
