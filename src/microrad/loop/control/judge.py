"""Residual and margins of many controllers on the same plants: what a search asks for a thousand times."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from microrad.core import lti
from microrad.core.arrays import Complexes, Floats
from microrad.loop.control import dips
from microrad.loop.control.analysis import around_poles, bandwidth_hz, cut, moved
from microrad.loop.control.problem import OPTICAL, RESIDUAL, AxisController, DesignPlant

CUTS = ("command", "optical")
"""Where a loop is cut for its margins; the second only where the controller uses both sensors."""

BEYOND = 10.0
"""What stands for |1 + L| at a cut that a loop does not have."""

AT_ONCE = 8192
"""Frequencies, of all controllers together, whose responses are worked out at once: what a processor keeps near."""


@dataclass(frozen=True, slots=True, eq=False)
class Verdict:
    """What a candidate reaches on all plants; no more than ``pole`` is known of one that is unstable.

    ``moduli`` are the least |1 + L| by cut, plant and band of frequencies: each is a smooth function of the parameters
    where the least of them all is not. ``bandwidths_hz`` are by plant.
    """

    pole: float
    mean_rad2: float
    moduli: Floats
    bandwidths_hz: Floats


class Judge:
    """Residual and margins of any controller on some plants, from responses that are computed once.

    The variance is the integral of the residual's spectrum over a grid that resolves every resonance of the plants;
    their frequencies stand one plant behind the other.
    """

    def __init__(self, plants: Sequence[DesignPlant]) -> None:
        """Compute the responses of the plants, once for all controllers.

        Args:
            plants: Plants of one axis, all of one control period.

        Raises:
            ValueError: For no plant, different periods, no disturbance, or one without stationary variance.
        """
        self._period = _one_period(plants)
        self._A, self._B, self._C, self._D = _stacked([moved(p).from_command for p in plants])
        grids = [grid(p.system, p.period_s) for p in plants]
        self._edges = np.cumsum([0, *(f.size for f in grids)])
        self._freq = np.concatenate(grids)  # falls from one plant to the next
        self._bands = _bands(grids, self._period)
        self._weights = np.concatenate([quadrature(f) for f in grids]) * 2.0 * self._period
        whole = np.concatenate(
            [lti.frequency_response(p.system, f, self._period) for p, f in zip(plants, grids, strict=True)]
        )
        self._to_sensors = whole[:, OPTICAL:, 0]
        white, seen = whole[:, RESIDUAL, 1:], whole[:, OPTICAL:, 1:]
        # The residual is white + to_residual (k0 seen0 + k1 seen1), k what of the sensors the command takes. As three
        # columns at each frequency, its size is that of their triangular factor: three numbers in place of all.
        taken = whole[:, RESIDUAL, 0, None, None] * seen
        columns = np.stack([white, taken[:, 0], taken[:, 1]], axis=2)
        self._parts: Complexes = np.asarray(np.linalg.qr(columns, "r"))
        different, self._of_points = np.unique(self._freq, return_inverse=True)  # most plants share most of theirs
        self._points = np.exp(2j * math.pi * different * self._period)
        self.open_rad2 = float(self._mean(white[None])[0])
        if self.open_rad2 <= 0.0:
            raise ValueError("the plant has no disturbance: without a loop its residual is 0; give it one to reject")

    def __call__(self, controller: AxisController) -> Verdict:
        """Judge one controller; its margins are those of the worst place to cut its loop, on the worst plant."""
        (found,) = self.several([controller])
        return found

    def several(self, controllers: Sequence[AxisController]) -> list[Verdict]:
        """Judge many controllers at once: each as it is judged alone, but for rounding."""
        found: list[Verdict] = [self.unstable(math.inf)] * len(controllers)
        alike: dict[int, list[int]] = {}
        for number, controller in enumerate(controllers):
            alike.setdefault(controller.system.order, []).append(number)
        share = max(1, AT_ONCE // self._freq.size)
        for numbers in alike.values():
            for first in range(0, len(numbers), share):
                some = numbers[first : first + share]
                for number, verdict in zip(some, self._judged([controllers[n].system for n in some]), strict=True):
                    found[number] = verdict
        return found

    def _judged(self, systems: Sequence[lti.StateSpace]) -> list[Verdict]:
        """Verdicts on controllers of one order."""
        stack = _Stack.of(systems)
        poles = self._spectral_radii(stack)
        found = [self.unstable(float(pole)) for pole in poles]
        sure = np.flatnonzero(poles < 1.0 - 1e-9)  # nearer than rounding can tell
        both = np.all(np.any(stack.B[sure] != 0.0, axis=1) | np.any(stack.D[sure] != 0.0, axis=1), axis=1)
        for numbers, cuts in ((sure[~both], CUTS[:1]), (sure[both], CUTS)):
            if numbers.size:
                for i, reached in zip(numbers, self._reached(stack.some(numbers), cuts), strict=True):
                    found[i] = Verdict(float(poles[i]), *reached)
        return found

    def _reached(self, stack: "_Stack", cuts: Sequence[str]) -> Iterator[tuple[float, Floats, Floats]]:
        """Mean variance, moduli and bandwidths of stable loops."""
        K = responses(stack, self._points)[:, self._of_points]
        whole = 1.0 + cut(K, self._to_sensors, "command")
        distances = [np.abs(whole)] + [np.abs(1.0 + cut(K, self._to_sensors, each)) for each in cuts[1:]]
        means = self._mean(self._residual(K / whole[..., None]))
        moduli = np.full((len(K), len(CUTS), self._bands.size), BEYOND)
        for i, distance in enumerate(self._dips(stack, cuts, distances)):
            moduli[:, i] = np.minimum.reduceat(distance, self._bands, axis=1)
        for mean, least, distance in zip(means, moduli, distances[-1], strict=True):
            yield float(mean), least.ravel(), self._bandwidths(distance)

    def _residual(self, taken: Complexes) -> Complexes:
        """Numbers (controllers, frequencies, 3) of the size of the residual, by what the command takes of sensors."""
        rows = self._parts[:, :, 0] + taken[..., :1] * self._parts[:, :, 1]
        return np.asarray(rows + taken[..., 1:] * self._parts[:, :, 2] if np.any(taken[..., 1]) else rows)

    def unstable(self, pole: float) -> Verdict:
        """What is said of a candidate that is unstable, or that could not be built."""
        return Verdict(pole, math.inf, np.zeros(len(CUTS) * self._bands.size), np.zeros(len(self._A)))

    def _spectral_radii(self, c: "_Stack") -> Floats:
        """Those of the closed loops on the worst plant; infinite where a number is not finite."""
        several, n, order = len(c.A), self._A.shape[1], c.A.shape[1]
        A, B, C, D = (each[:, None] for each in (c.A, c.B, c.C, c.D))
        whole = np.empty((several, len(self._A), n + order, n + order))
        whole[..., :n, :n], whole[..., :n, n:] = self._A + self._B @ D @ self._C, self._B @ C
        whole[..., n:, :n], whole[..., n:, n:] = B @ self._C, A
        finite = np.all(np.isfinite(whole), axis=(1, 2, 3))
        radii = np.full(several, math.inf)
        radii[finite] = np.max(np.abs(np.linalg.eigvals(whole[finite])), axis=(1, 2))
        return radii

    def _mean(self, white: Complexes) -> Floats:
        """Mean over the plants of the variance that responses (controllers, frequencies, white sequences) leave."""
        spectrum = np.sum(white.real**2 + white.imag**2, axis=2)
        return np.asarray(np.mean(np.add.reduceat(self._weights * spectrum, self._edges[:-1], axis=1), axis=1))

    def _dips(self, stack: "_Stack", cuts: Sequence[str], distances: Sequence[Floats]) -> list[Floats]:
        """The distances by cut, each local minimum on the grid replaced by the least between its points: see `dips`."""
        by_cut = []
        deepest = dips.NEAR_LEAST * np.min([np.min(distance, axis=1) for distance in distances], axis=0)
        for broken_at, distance in zip(cuts, distances, strict=True):
            found, each = distance.copy(), dips.on_grid(distance**2, self._freq)
            found[each.row, each.at] = np.sqrt(np.maximum(each.squared, 0.0))
            near = found[each.row, each.at] < deepest[each.row]
            of, at = each.row[near], each.at[near]
            plant = np.searchsorted(self._edges, at, side="right") - 1
            squared_at = partial(self._squared, stack.some(of), broken_at, plant)
            least = dips.followed(squared_at, each.freq_hz[near], each.width_hz[near])
            found[of, at] = np.sqrt(np.maximum(least, 0.0))
            by_cut.append(found)
        return by_cut

    def _squared(self, stack: "_Stack", broken_at: str, plant: NDArray[np.intp], freq_hz: Floats) -> Floats:
        """|1 + L|^2 of controllers on plants, one of each for each row of frequencies."""
        points = np.exp(2j * math.pi * self._period * freq_hz)[..., None, None]
        K = _solved(points, stack.A, stack.B, stack.C, stack.D)[..., 0, :]
        G = _solved(points, self._A[plant], self._B[plant], self._C[plant], self._D[plant])[..., 0]
        return np.abs(1.0 + cut(K, G, broken_at)) ** 2

    def _bandwidths(self, distance: Floats) -> Floats:
        parts = (slice(*edge) for edge in zip(self._edges[:-1], self._edges[1:], strict=True))
        return np.array([bandwidth_hz(self._freq[part], distance[part]) for part in parts])


def _one_period(plants: Sequence[DesignPlant]) -> float:
    if not plants:
        raise ValueError("nothing to tune for: give at least the nominal plant")
    periods = {p.period_s for p in plants}
    if len(periods) > 1:
        raise ValueError(
            f"plants of different control periods, {min(periods):g} to {max(periods):g} s: a controller has one rate"
        )
    for p in plants:
        worst = float(np.max(np.abs(np.linalg.eigvals(p.system.A)), initial=0.0))
        if worst >= 1.0:
            raise ValueError(
                f"a plant has a pole at |z| = {worst:.9f} (the limit is 1): it or its disturbance is not "
                "stationary; give the disturbance some damping"
            )
    return periods.pop()


def grid(system: lti.StateSpace, period_s: float) -> Floats:
    """Some 500 frequencies to half the control rate: logarithmic from below the slowest pole, linear, and by pole.

    Args:
        system: A plant, discrete.
        period_s: Control period, s.
    """
    poles = np.linalg.eigvals(system.A).astype(complex)
    slow = np.abs(np.log(poles[np.abs(poles) > 0.5])) / (2 * math.pi)
    lowest = max(min(1e-4, float(np.min(slow, initial=1.0))) / 20.0, 1e-9)
    parts = [np.geomspace(lowest, 0.5, 240), np.linspace(0.0, 0.5, 121)[1:]]
    return np.unique(np.concatenate([*(f / period_s for f in parts), around_poles(poles, period_s, 1.2)]))


def _bands(grids: Sequence[Floats], period_s: float) -> NDArray[np.intp]:
    """First index of each band, plant by plant: below a thousandth of the rate, then ten on a logarithmic scale."""
    edges = np.geomspace(1e-3, 0.5, 11)[:-1] / period_s
    number = [np.searchsorted(edges, f, side="right") for f in grids]
    return np.flatnonzero(np.diff(np.concatenate(number), prepend=-1))


def quadrature(f: Floats) -> Floats:
    """Weights of the trapezoidal rule, with the value at the lowest frequency held down to 0."""
    steps = np.diff(f)
    weights = np.zeros(f.size)
    weights[:-1] += 0.5 * steps
    weights[1:] += 0.5 * steps
    weights[0] += f[0]
    return weights


def _stacked(systems: Sequence[lti.StateSpace]) -> tuple[Floats, Floats, Floats, Floats]:
    """Matrices of several systems, each with a first index by system; states that one lacks are at rest in it."""
    n, several = max(s.order for s in systems), len(systems)
    inputs, outputs = systems[0].B.shape[1], systems[0].C.shape[0]
    A, B, C = np.zeros((several, n, n)), np.zeros((several, n, inputs)), np.zeros((several, outputs, n))
    for i, s in enumerate(systems):
        A[i, : s.order, : s.order], B[i, : s.order], C[i, :, : s.order] = s.A, s.B, s.C
    return A, B, C, np.array([s.D for s in systems])


def _solved(points: Complexes, A: Floats, B: Floats, C: Floats, D: Floats) -> Complexes:
    """Responses C (z - A)^-1 B + D of systems (first index) at points z of their own, shape (systems, points, 1, 1)."""
    resolvent = points * np.eye(A.shape[1]) - A[:, None]
    driven = np.broadcast_to(B[:, None], (*points.shape[:2], *B.shape[1:]))
    return np.asarray(C[:, None] @ np.linalg.solve(resolvent, driven) + D[:, None])


@dataclass(frozen=True, slots=True)
class _Stack:
    """Matrices of controllers of one order, each with a first index by controller."""

    A: Floats
    B: Floats
    C: Floats
    D: Floats

    @classmethod
    def of(cls, systems: Sequence[lti.StateSpace]) -> "_Stack":
        return cls(*(np.array([getattr(s, key) for s in systems]) for key in "ABCD"))

    def some(self, numbers: NDArray[np.intp]) -> "_Stack":
        return _Stack(self.A[numbers], self.B[numbers], self.C[numbers], self.D[numbers])


def response(system: lti.StateSpace, points: Complexes) -> Complexes:
    """Response of a controller (one output) at points z, shape (points, inputs).

    Args:
        system: The controller, discrete.
        points: Complex points z, shape (points,); exp(2 pi i f T) for a frequency f.
    """
    return np.asarray(responses(_Stack.of([system]), points)[0])


def responses(stack: _Stack, points: Complexes) -> Complexes:
    """Responses of controllers (one output) at points z, shape (controllers, points, inputs).

    Args:
        stack: Matrices of the controllers, all of one order.
        points: Complex points z, shape (points,); exp(2 pi i f T) for a frequency f.
    """
    several, order = stack.A.shape[:2]
    if not order:
        return np.broadcast_to(stack.D.astype(complex), (several, points.size, stack.D.shape[2]))
    if order == 1:
        return np.asarray(stack.C * stack.B / (points - stack.A[:, 0])[..., None] + stack.D)
    rows = lti.resolvent_rows(stack.A, stack.C, points)[:, 0]
    return np.asarray(rows.swapaxes(1, 2) @ stack.B + stack.D)
