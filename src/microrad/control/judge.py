"""Residual and margins of many controllers on the same plants: what a search asks for a thousand times."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from microrad import lti
from microrad.control.analysis import around_poles, bandwidth_hz, cut, moved, uses_both
from microrad.control.problem import OPTICAL, RESIDUAL, AxisController, DesignPlant

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]


@dataclass(frozen=True, slots=True, eq=False)
class Verdict:
    """What a candidate reaches on all plants; no more than ``pole`` is known of one that is unstable.

    ``moduli`` are the least |1 + L| by plant and band of frequencies: each is a smooth function of the parameters where
    the least of them all is not. ``bandwidths_hz`` are by plant.
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
        self._plants = [moved(p) for p in plants]
        self._period = _one_period(plants)
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
        pole = max(_spectral_radius(p, controller) for p in self._plants)
        if not pole < 1.0 - 1e-9:  # nearer than rounding can tell
            return self.unstable(pole)
        K = response(controller.system, self._points)
        whole = np.abs(1.0 + cut(K, self._to_sensors, "command"))
        optical = np.abs(1.0 + cut(K, self._to_sensors, "optical")) if uses_both(controller) else whole
        command = K[:, :1] * self._seen[:, 0] + K[:, 1:] * self._seen[:, 1]
        command /= (1.0 + cut(K, self._to_sensors, "command"))[:, None]
        residual = self._white + self._to_residual[:, None] * command
        least = np.minimum(self._dips(whole), self._dips(optical)) if optical is not whole else self._dips(whole)
        moduli = np.minimum.reduceat(least, self._bands)
        return Verdict(pole, self._mean(residual), moduli, self._bandwidths(optical))

    def unstable(self, pole: float) -> Verdict:
        """What is said of a candidate that is unstable, or that could not be built."""
        return Verdict(pole, math.inf, np.zeros(self._bands.size), np.zeros(len(self._plants)))

    def _mean(self, white: Complexes) -> float:
        """Mean over the plants of the variance that these responses to the white sequences leave."""
        spectrum = np.sum(white.real**2 + white.imag**2, axis=1)
        return float(np.mean(np.add.reduceat(self._weights * spectrum, self._edges[:-1])))

    def _dips(self, distance: Floats) -> Floats:
        """The distance with each local minimum replaced by that of a parabola through it and its neighbours."""
        squared, before, after = distance**2, self._steps[:-1], self._steps[1:]
        left, right = np.diff(squared)[:-1] / before, np.diff(squared)[1:] / after
        slope, curvature = (left * after + right * before) / (before + after), (right - left) / (before + after)
        at = np.flatnonzero((left < 0.0) & (right > 0.0) & (before > 0.0) & (after > 0.0))
        squared[at + 1] -= slope[at] ** 2 / (4.0 * curvature[at])
        return np.sqrt(np.maximum(squared, 0.0))

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


def _spectral_radius(plant: DesignPlant, controller: AxisController) -> float:
    p, c = plant.system, controller.system
    seen = p.C[OPTICAL:]
    A = np.block([[p.A + p.B @ c.D @ seen, p.B @ c.C], [c.B @ seen, c.A]])
    return float(np.max(np.abs(np.linalg.eigvals(A)))) if np.all(np.isfinite(A)) else math.inf


def response(system: lti.StateSpace, points: Complexes) -> Complexes:
    """Response of a controller at points z, shape (points, inputs).

    By forward substitution in its Schur form A = U T U', all points at once: the row r (z - T) = C U, then r U' B + D.
    """
    from scipy.linalg import schur  # slow to import, not needed to show help

    T, U = schur(system.A.astype(complex)) if system.order else (system.A.astype(complex),) * 2
    row, start = np.empty((system.order, points.size), dtype=complex), (system.C @ U)[0]
    for j in range(system.order):
        row[j] = (start[j] + T[:j, j] @ row[:j]) / (points - T[j, j])
    return np.asarray(row.T @ (U.conj().T @ system.B) + system.D[0])
