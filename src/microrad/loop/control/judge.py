"""Residual and margins of many controllers on the same plants: what a search asks for a thousand times."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from microrad.core import lti
from microrad.core.arrays import Complexes, Floats
from microrad.loop.control.analysis import around_poles, bandwidth_hz, cut, moved, uses_both
from microrad.loop.control.problem import OPTICAL, RESIDUAL, AxisController, DesignPlant

CUTS = ("command", "optical")
"""Where a loop is cut for its margins; the second only where the controller uses both sensors."""

BEYOND = 10.0
"""What stands for |1 + L| at a cut that a loop does not have."""

NEAR_LEAST = 1.3
"""Dips of |1 + L| within this factor of the deepest one are followed between the grid's points."""

CLOSER = (0.05, 0.0025)
"""Half widths, over the grid's step, of the three points through which the parabola is laid again and again."""


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
        """Raise ValueError for no plant, different periods, no disturbance, or one without stationary variance."""
        self._period = _one_period(plants)
        self._A, self._B, self._C, self._D = _stacked([moved(p).from_command for p in plants])
        grids = [_grid(p) for p in plants]
        self._edges = np.cumsum([0, *(f.size for f in grids)])
        self._freq = np.concatenate(grids)
        self._steps = np.diff(self._freq)  # below 0 from one plant to the next
        self._bands = _bands(grids, self._period)
        self._weights = np.concatenate([_quadrature(f) for f in grids]) * 2.0 * self._period
        whole = np.concatenate(
            [lti.frequency_response(p.system, f, self._period) for p, f in zip(plants, grids, strict=True)]
        )
        self._to_residual, self._to_sensors = whole[:, RESIDUAL, 0], whole[:, OPTICAL:, 0]
        self._white, self._seen = whole[:, RESIDUAL, 1:], whole[:, OPTICAL:, 1:]
        self._points = np.exp(2j * math.pi * self._freq * self._period)
        self.open_rad2 = self._mean(self._white)
        if self.open_rad2 <= 0.0:
            raise ValueError("the plant has no disturbance: without a loop its residual is 0; give it one to reject")

    def __call__(self, controller: AxisController) -> Verdict:
        """Judge one controller; its margins are those of the worst place to cut its loop, on the worst plant."""
        pole = self._spectral_radius(controller)
        if not pole < 1.0 - 1e-9:  # nearer than rounding can tell
            return self.unstable(pole)
        K = response(controller.system, self._points)
        whole = 1.0 + cut(K, self._to_sensors, "command")
        cuts = {"command": np.abs(whole)}
        if uses_both(controller):
            cuts["optical"] = np.abs(1.0 + cut(K, self._to_sensors, "optical"))
        command = K[:, :1] * self._seen[:, 0] + K[:, 1:] * self._seen[:, 1]
        command /= whole[:, None]
        residual = self._white + self._to_residual[:, None] * command
        moduli = np.full((len(CUTS), self._bands.size), BEYOND)
        for row, dips in zip(moduli, self._dips(controller, cuts), strict=False):
            row[:] = np.minimum.reduceat(dips, self._bands)
        bandwidths = self._bandwidths(cuts.get("optical", cuts["command"]))
        return Verdict(pole, self._mean(residual), moduli.ravel(), bandwidths)

    def unstable(self, pole: float) -> Verdict:
        """What is said of a candidate that is unstable, or that could not be built."""
        return Verdict(pole, math.inf, np.zeros(len(CUTS) * self._bands.size), np.zeros(len(self._A)))

    def _spectral_radius(self, controller: AxisController) -> float:
        """That of the closed loop on the worst plant."""
        c, n = controller.system, self._A.shape[1]
        whole = np.empty((len(self._A), n + c.order, n + c.order))
        whole[:, :n, :n], whole[:, :n, n:] = self._A + self._B @ c.D @ self._C, self._B @ c.C
        whole[:, n:, :n], whole[:, n:, n:] = c.B @ self._C, c.A
        return float(np.max(np.abs(np.linalg.eigvals(whole)))) if np.all(np.isfinite(whole)) else math.inf

    def _mean(self, white: Complexes) -> float:
        """Mean over the plants of the variance that these responses to the white sequences leave."""
        spectrum = np.sum(white.real**2 + white.imag**2, axis=1)
        return float(np.mean(np.add.reduceat(self._weights * spectrum, self._edges[:-1])))

    def _dips(self, controller: AxisController, cuts: dict[str, Floats]) -> list[Floats]:
        """The distances by cut, each local minimum on the grid replaced by the least between its points.

        A parabola through a minimum and its neighbours tells where it is; what is near the least of all is looked at
        again there, more closely each time, so that the least moves smoothly with the controller.
        """
        by_cut = []
        deepest = NEAR_LEAST * min(float(np.min(distance)) for distance in cuts.values())
        for broken_at, distance in cuts.items():
            found = distance.copy()
            at, where, squared = self._minima(distance)
            found[at] = np.sqrt(np.maximum(squared, 0.0))
            near = found[at] < deepest
            found[at[near]] = self._closer(controller, broken_at, at[near], where[near])
            by_cut.append(found)
        return by_cut

    def _minima(self, distance: Floats) -> tuple[NDArray[np.intp], Floats, Floats]:
        """Places on the grid, frequencies and squares of the local minima, by parabolas through three points each."""
        squared, before, after = distance**2, self._steps[:-1], self._steps[1:]
        left, right = np.diff(squared)[:-1] / before, np.diff(squared)[1:] / after
        slope, curvature = (left * after + right * before) / (before + after), (right - left) / (before + after)
        at = np.flatnonzero((left < 0.0) & (right > 0.0) & (before > 0.0) & (after > 0.0))
        where = self._freq[at + 1] - slope[at] / (2.0 * curvature[at])
        return at + 1, where, squared[at + 1] - slope[at] ** 2 / (4.0 * curvature[at])

    def _closer(self, controller: AxisController, broken_at: str, at: NDArray[np.intp], freq_hz: Floats) -> Floats:
        """Minima of the distance near some frequencies, beside the places ``at`` of the grid."""
        plant = np.searchsorted(self._edges, at, side="right") - 1
        width, least = np.minimum(self._steps[at - 1], self._steps[at]), np.zeros(at.size)
        for share in CLOSER:
            step = share * width
            near = freq_hz[:, None] + step[:, None] * np.array([-1.0, 0.0, 1.0])
            squared = self._distance(controller, broken_at, plant, near) ** 2
            slope = 0.5 * (squared[:, 2] - squared[:, 0])
            curvature = squared[:, 2] - 2.0 * squared[:, 1] + squared[:, 0]
            moved = np.where(curvature > 0.0, -slope / np.where(curvature > 0.0, curvature, 1.0), 0.0)
            moved = np.clip(moved, -0.5 / share, 0.5 / share)  # within the grid's own step
            freq_hz = freq_hz + moved * step
            least = squared[:, 1] + moved * (slope + 0.5 * moved * curvature)
        return np.sqrt(np.maximum(least, 0.0))

    def _distance(self, controller: AxisController, broken_at: str, plant: NDArray[np.intp], freq_hz: Floats) -> Floats:
        """|1 + L| of these plants (one for each row) at any frequencies."""
        K = lti.frequency_response(controller.system, freq_hz.ravel(), self._period).reshape(*freq_hz.shape, 2)
        points = np.exp(2j * math.pi * self._period * freq_hz)[..., None, None]
        resolvent = points * np.eye(self._A.shape[1]) - self._A[plant, None]
        driven = np.broadcast_to(self._B[plant, None], (*freq_hz.shape, *self._B.shape[1:]))
        G = self._C[plant, None] @ np.linalg.solve(resolvent, driven) + self._D[plant, None]
        return np.abs(1.0 + cut(K, np.asarray(G[..., 0], dtype=complex), broken_at))

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


def _grid(plant: DesignPlant) -> Floats:
    """Some 500 frequencies to half the control rate: logarithmic from below the slowest pole, linear, and by pole."""
    poles = np.linalg.eigvals(plant.system.A).astype(complex)
    slow = np.abs(np.log(poles[np.abs(poles) > 0.5])) / (2 * math.pi)
    lowest = max(min(1e-4, float(np.min(slow, initial=1.0))) / 20.0, 1e-9)
    grid = [np.geomspace(lowest, 0.5, 240), np.linspace(0.0, 0.5, 121)[1:]]
    return np.unique(np.concatenate([*(f / plant.period_s for f in grid), around_poles(poles, plant.period_s, 1.2)]))


def _bands(grids: Sequence[Floats], period_s: float) -> NDArray[np.intp]:
    """First index of each band, plant by plant: below a thousandth of the rate, then ten on a logarithmic scale."""
    edges = np.geomspace(1e-3, 0.5, 11)[:-1] / period_s
    number = [np.searchsorted(edges, f, side="right") for f in grids]
    return np.flatnonzero(np.diff(np.concatenate(number), prepend=-1))


def _quadrature(f: Floats) -> Floats:
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


def response(system: lti.StateSpace, points: Complexes) -> Complexes:
    """Response of a controller (one output) at points z, shape (points, inputs).

    By forward substitution in its Schur form A = U T U', all points at once: the row r (z - T) = C U, then r U' B + D.
    States in volts beside states in radians cost Schur's rotations the digits of the small ones: they are scaled first,
    by powers of 2 that make rows and columns of A alike, and the rows are corrected once by what they leave of C.
    """
    from scipy.linalg import matrix_balance, schur  # slow to import, not needed to show help

    if not system.order:
        return np.broadcast_to(system.D[0].astype(complex), (points.size, system.D.shape[1]))
    A, (scale, _) = matrix_balance(system.A, permute=False, separate=True)
    T, U = schur(A.astype(complex))
    near = 1.0 / (points - np.diag(T)[:, None])

    def rows(right: Complexes) -> Complexes:
        start = U.T @ right
        found = np.empty(near.shape, dtype=complex)
        for j in range(T.shape[0]):
            found[j] = (start[j] + T[:j, j] @ found[:j]) * near[j]
        return np.asarray(U.conj() @ found)

    C = (system.C * scale).T
    first = rows(C.astype(complex))
    second = first + rows(C - (first * points - A.T @ first))
    return np.asarray(second.T @ (system.B / scale[:, None]) + system.D[0])
