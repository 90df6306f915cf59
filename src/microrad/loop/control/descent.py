"""Local search: from one candidate to the optimum under constraints beside it, and to its last digit."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from itertools import combinations, product

import numpy as np

from microrad.core.arrays import Floats
from microrad.loop.control.search import Search, Trial

STEP = 1e-4
"""Step of the rough search's differences, to one side, over a parameter's range: it ends half a step off an optimum."""

ROUGH, EXACT = (1e-6, 30), (1e-20, 200)
"""Gain of cost and number of iterations at which a program ends, of the candidates themselves and of their model."""

NODE = 3e-3
"""First distance of the five points of a derivative: it errs by some 1e-10 of rounding and 3e-12 of the fifth one."""

REACH, LEAST_REACH = 0.1, 1e-4
"""How far the optimum of a quadratic model is trusted, at first and at last, over a parameter's range."""

SAME_PLACE = 1e-8
"""Change of a place, over the bounds, at which an optimum stands still."""

SAME_SCORE = 1e-9
"""Rise of the score that is rounding."""

MODELS = 25
"""Quadratic models after which an optimum is taken as it is."""

NEAR = 0.3
"""Excess over what is asked for from which a constraint is left out of the model."""


# ------------------------------------------------------------------------------------------------ to the optimum


class _Local:
    """Cost and constraints around one trial, with derivatives by differences; each place is judged once."""

    def __init__(self, search: Search) -> None:
        self._search = search
        self._known: dict[bytes, Trial] = {}
        self._near: dict[bytes, list[Trial]] = {}
        self._asked = False

    def at(self, place: Floats) -> Trial:
        """The trial at a place; what its slopes take is judged along with it where those of the last one were asked."""
        key = place.tobytes()
        if key not in self._known:
            beside = self._beside(place) if self._asked else []
            self._known[key], *self._near[key] = self._search.at_all([place, *beside])
            self._asked = False
        return self._known[key]

    def slopes(self, place: Floats) -> Floats:
        """Gradients of cost and constraints (rows), by a step towards the middle of the bounds."""
        here, key = self.at(place), place.tobytes()
        self._asked = True
        self._near[key] = self._near[key] or self._search.at_all(self._beside(place))
        steps = _steps(place)
        return np.array(
            [(_numbers(t) - _numbers(here)) / step for t, step in zip(self._near[key], steps, strict=True)]
        ).T

    def _beside(self, place: Floats) -> list[Floats]:
        inside = np.clip(place, 0.0, 1.0)  # a line search may look beyond
        return [_with(inside, i, inside[i] + step) for i, step in enumerate(_steps(place))]


def _steps(place: Floats) -> Floats:
    return np.where(place < 0.5, STEP, -STEP)


def _with(place: Floats, i: int, x: float) -> Floats:
    there = place.copy()
    there[i] = x
    return there


def _numbers(trial: Trial) -> Floats:
    """Cost and excesses of a trial in one row."""
    return np.append(trial.cost, trial.excess)


def descend(search: Search, start: Trial) -> Trial:
    """Follow a sequence of quadratic programs from a trial to near an optimum, from where `settle` goes on.

    Args:
        search: Judges the candidates.
        start: Trial to set out from.
    """
    if not start.place.size:
        return start
    local = _Local(search)
    return local.at(_programmed(lambda x: _numbers(local.at(x)), local.slopes, start.place, (0.0, 1.0), ROUGH))


def _programmed(
    numbers: Callable[[Floats], Floats],
    slopes: Callable[[Floats], Floats],
    start: Floats,
    bounds: tuple[Floats | float, Floats | float],
    ending: tuple[float, int],
) -> Floats:
    """Where the first of the numbers is least within bounds while none of the others is below 0.

    By SLSQP: Kraft, DFVLR-FB 88-28, 1988. ``ending`` is `ROUGH` or `EXACT`.
    """
    from scipy.optimize import minimize

    (low, high), (gain, iterations), eye = bounds, ending, np.eye(start.size)
    inside = {
        "type": "ineq",
        "fun": lambda x: np.concatenate([numbers(x)[1:], x - low, high - x]),
        "jac": lambda x: np.vstack([slopes(x)[1:], eye, -eye]),
    }
    found = minimize(
        lambda x: numbers(x)[0],
        start,
        jac=lambda x: slopes(x)[0].copy(),  # SLSQP writes into it
        method="SLSQP",
        constraints=[inside],
        options={"maxiter": iterations, "ftol": gain},
    )
    return np.asarray(np.clip(found.x, low, high))


# ------------------------------------------------------------------------------------------------ to its last digit


@dataclass(frozen=True, slots=True)
class _Quadratic:
    """Cost (first row) and near constraints as quadratic functions of the step from a place."""

    value: Floats
    slope: Floats
    bend: Floats

    def at(self, step: Floats) -> Floats:
        return self.value + self.slope @ step + 0.5 * (self.bend @ step) @ step

    def gradient(self, step: Floats) -> Floats:
        return self.slope + self.bend @ step


def settle(search: Search, start: Trial, models: int = MODELS) -> Trial:
    """Find the optimum beside a trial, by the optima of quadratic models until one stands still.

    A search that builds up its curvature as it goes stops where the cost hardly falls, which in a flat valley is
    anywhere; the model's curvature is that of the valley. Where a model has misled, the next one reaches less far and
    lays its points closer: a constraint that changes from one dip of |1 + L| to another has a kink.

    Args:
        search: Judges the candidates.
        start: Trial near the optimum, as `descend` finds it.
        models: Most quadratic models; each takes some twice the square of the parameters' number in candidates.
    """
    here, reach, node = start, REACH, NODE
    for _ in range(models if start.place.size else 0):
        model = _model(search, here, node)
        if model is None:
            break
        there = search.at(here.place + _optimum(model, here.place, reach))
        moved = float(np.max(np.abs(there.place - here.place)))
        if moved < SAME_PLACE:
            return there
        if there.score <= here.score + SAME_SCORE:
            here = there
        elif reach < LEAST_REACH:
            break
        else:
            reach, node = 0.25 * reach, 0.5 * node
    return here


def _optimum(model: _Quadratic, place: Floats, reach: float) -> Floats:
    """The step to the optimum of the model, within the bounds and the reach."""
    if np.any(model.value[1:] < 0.0) and reach < REACH:  # a constraint that is not met yet may need more than the reach
        reach = REACH
    bounds = np.maximum(-place, -reach), np.minimum(1.0 - place, reach)
    own = np.eye(model.value.size)[0] * model.value[0]  # the cost itself is large beside what a step gains
    return _programmed(lambda x: model.at(x) - own, model.gradient, np.zeros(place.size), bounds, EXACT)


def _model(search: Search, here: Trial, node: float) -> _Quadratic | None:
    """Value, slope and bend by differences of the fourth order; None where a candidate beside ``here`` is unstable."""
    place, d = here.place, here.place.size
    offsets = [_offsets(float(x), node) for x in place]
    near = np.append(True, here.excess < NEAR)
    value = _numbers(here)[near]
    slope, bend = np.zeros((value.size, d)), np.zeros((value.size, d, d))

    def moved(*moves: tuple[int, float]) -> Floats:
        there = place.copy()
        for i, offset in moves:
            there[i] += node * offset
        return there

    pairs = list(combinations(range(d), 2))
    lines = [moved((i, offset)) for i in range(d) for offset in offsets[i] if offset != 0.0]
    corners = [moved((i, offsets[i][m]), (j, offsets[j][n])) for i, j in pairs for m, n in product((1, 3), (1, 3))]
    judged = iter(search.at_all([*lines, *corners]))

    def numbers() -> Floats:
        trial = next(judged)
        return _numbers(trial)[near] if trial.verdict.pole < 1.0 else np.full(value.size, np.nan)

    for i in range(d):
        points = np.array([value if offset == 0.0 else numbers() for offset in offsets[i]])
        slope[:, i], bend[:, i, i] = (_weights(offsets[i], order) @ points / node**order for order in (1, 2))
    for i, j in pairs:
        low_left, low_right, high_left, high_right = (numbers() for _ in range(4))
        area = node**2 * (offsets[i][3] - offsets[i][1]) * (offsets[j][3] - offsets[j][1])
        bend[:, i, j] = bend[:, j, i] = ((low_left + high_right) - (high_left + low_right)) / area
    return _Quadratic(value, slope, bend) if np.all(np.isfinite(bend)) else None


def _offsets(x: float, node: float) -> Floats:
    """Five points about a coordinate, in nodes, all within the bounds."""
    room = max(0.0, 2.0 - x / node) - max(0.0, 2.0 - (1.0 - x) / node)
    return np.arange(-2.0, 3.0) + room


def _weights(offsets: Floats, order: int) -> Floats:
    """Weights of the points in the first or second derivative, exact for polynomials of the fourth degree."""
    powers = np.vander(offsets, increasing=True).T
    return np.asarray(np.linalg.solve(powers, math.factorial(order) * np.eye(offsets.size)[order]))
