"""All axes at once: what a controller of all of them leaves, how far its loop is from -1, and families of such."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from microrad.core import lti
from microrad.core.arrays import Complexes, Floats
from microrad.loop.control import (
    AxisController,
    DesignPlant,
    MultiloopMargin,
    WholeController,
    WholePlant,
    dips,
    multiloop_disk_margin,
)
from microrad.loop.control.analysis import bandwidth_hz, reachable, resolving
from microrad.loop.control.classical import LIGHT_DAMPING
from microrad.loop.control.judge import Verdict, grid, quadrature
from microrad.loop.control.search import Scope

BANDS = 10
"""Bands of frequencies, in each of which the least modulus is a smooth number of its own."""


@dataclass(frozen=True, slots=True)
class WholeMargins:
    """Margins of a stable loop of all axes.

    ``modulus`` is the least singular value of 1 + L, L the loop gain at the optical sensor, ``disk`` the disk margin
    against changes of all loops at once, and ``bandwidth_hz`` the lowest frequency at which the error of some direction
    is not rejected any more: the largest singular value of the sensitivity reaches 1.
    """

    modulus: float
    disk: MultiloopMargin
    bandwidth_hz: float


class WholeJudge:
    """Residual and margin of any controller of all axes on some plants, from responses that are computed once."""

    def __init__(self, plants: Sequence[WholePlant]) -> None:
        """Compute the responses of the plants, once for all controllers.

        Args:
            plants: Plants of the same axes and control period.
        """
        self._plants, self._moved = plants, [_moved(p) for p in plants]
        self._freq = [grid(p.system, p.period_s) for p in plants]
        # Plants share most of their frequencies: a controller answers once at each.
        self._different, places = np.unique(np.concatenate(self._freq), return_inverse=True)
        self._places = np.split(places, np.cumsum([f.size for f in self._freq])[:-1])
        self._whole = [lti.frequency_response(p.system, f, p.period_s) for p, f in zip(plants, self._freq, strict=True)]
        edges = [np.geomspace(1e-3, 0.5, BANDS)[:-1] / p.period_s for p in plants]
        bands = [np.searchsorted(e, f, side="right") for e, f in zip(edges, self._freq, strict=True)]
        self._bands = [np.flatnonzero(np.diff(each, prepend=-1)) for each in bands]
        # Residuals and readings of the white sequences by a triangular factor of the same size: as few columns as rows.
        turned = [whole[:, :, p.axes :].conj().swapaxes(1, 2) for p, whole in zip(plants, self._whole, strict=True)]
        self._white = [np.asarray(np.linalg.qr(each, "r")).conj().swapaxes(1, 2) for each in turned]
        without = (self._variance(i, white[:, : plants[0].axes]) for i, white in enumerate(self._white))
        self.open_rad2 = float(np.mean(list(without)))

    def several(self, controllers: Sequence[WholeController]) -> list[Verdict]:
        """Judge controllers one by one."""
        return [self._judged(each.system) for each in controllers]

    def unstable(self, pole: float) -> Verdict:
        """What is said of a candidate that is unstable, or that could not be built."""
        return Verdict(pole, math.inf, np.zeros(sum(map(len, self._bands))), np.zeros(len(self._plants)))

    def _judged(self, system: lti.StateSpace) -> Verdict:
        poles = [np.linalg.eigvals(closed_map(p, system)).astype(complex) for p in self._moved]
        pole = max(float(np.max(np.abs(each))) for each in poles)
        if not pole < 1.0 - 1e-9:
            return self.unstable(pole)
        variances, moduli = [], []
        response = _response(system, self._different, self._plants[0].period_s)
        for i, (p, freq, whole) in enumerate(zip(self._moved, self._freq, self._whole, strict=True)):
            axes, K = p.axes, response[self._places[i]]
            returned = np.eye(axes) - whole[:, axes:, :axes] @ K
            taken = whole[:, :axes, :axes] @ (K @ _inverse(returned))
            variances.append(self._variance(i, self._white[i][:, :axes] + taken @ self._white[i][:, axes:]))
            moduli.append(np.minimum.reduceat(least_moduli(p, system, freq, returned, poles[i]), self._bands[i]))
        return Verdict(pole, float(np.mean(variances)), np.concatenate(moduli), np.zeros(len(self._plants)))

    def _variance(self, number: int, left: Complexes) -> float:
        spectrum = np.sum(left.real**2 + left.imag**2, axis=(1, 2))
        return 2.0 * self._plants[number].period_s * float(quadrature(self._freq[number]) @ spectrum)


def least_moduli(
    plant: WholePlant, system: lti.StateSpace, freq: Floats, returned: Complexes, poles: Complexes
) -> Floats:
    """Least singular values of 1 + L on a grid, each local minimum by what is least between its points.

    Minima are followed as `dips` says; so is each light resonance of the closed loop, whose dip may lie between two
    points.

    Args:
        plant: The plant of all axes, without what its commands do not reach.
        system: A controller from the optical errors to the commands.
        freq: The grid, rising, in Hz.
        returned: 1 + L there, shape (frequencies, axes, axes).
        poles: Poles of the closed loop.
    """
    squared = least_squares(returned)
    each, lowest = dips.on_grid(squared[None], freq), squared.copy()
    lowest[each.at] = each.squared
    near = each.squared < dips.NEAR_LEAST**2 * np.min(squared)
    at, half = _resonances(poles, plant.period_s)
    places = np.clip(np.searchsorted(freq, at), 1, freq.size - 2)
    finer = half < 0.5 * (freq[places + 1] - freq[places - 1])
    where, width = (
        np.concatenate([own[near], lights[finer]]) for own, lights in ((each.freq_hz, at), (each.width_hz, half))
    )
    found = dips.followed(
        lambda points: least_squares(_returned(plant, system, points.ravel())).reshape(-1, 3), where, width
    )
    lowest[each.at[near]] = math.inf  # what the parabola said
    np.minimum.at(lowest, np.concatenate([each.at[near], places[finer]]), found)
    return np.sqrt(np.maximum(lowest, 0.0))


def _resonances(poles: Complexes, period_s: float) -> tuple[Floats, Floats]:
    """Frequencies and half widths (Hz) of light poles below half the rate."""
    s = np.log(poles[np.abs(poles) > 0.1].astype(complex)) / (2.0 * math.pi * period_s)
    light = s[(s.imag > 0.0) & (-s.real < LIGHT_DAMPING * np.abs(s)) & (s.imag < 0.499 / period_s)]
    return np.asarray(light.imag), np.maximum(-light.real, 1e-9 / period_s)


def _returned(plant: WholePlant, system: lti.StateSpace, freq: Floats) -> Complexes:
    """1 + L, the loop cut at the optical sensor, shape (frequencies, axes, axes)."""
    s, axes = plant.system, plant.axes
    to_sensor = lti.StateSpace(s.A, s.B[:, :axes], s.C[axes:], np.zeros((axes, axes)))
    to_command = lti.frequency_response(system, freq, plant.period_s)
    return np.asarray(np.eye(axes) - lti.frequency_response(to_sensor, freq, plant.period_s) @ to_command)


def least_squares(matrices: Complexes) -> Floats:
    """Squares of the least singular values of matrices of two rows and columns, shape (matrices, 2, 2).

    Each has all its digits also where both singular values are alike, as those of axes that are: the square of their
    difference is |M - t adj(M)^H|^2 / 2, with t the determinant over its magnitude, and no difference of large numbers.
    """
    (a, b), (c, d) = np.moveaxis(matrices, 0, 2)
    squares = np.sum(matrices.real**2 + matrices.imag**2, axis=(1, 2))
    determinant = _determinant(matrices)
    size = np.abs(determinant)
    t = np.divide(determinant, size, out=np.ones_like(determinant), where=size > 0.0)
    largest = 0.5 * (np.sqrt(squares + 2.0 * size) + np.hypot(np.abs(a - t * d.conj()), np.abs(b + t * c.conj())))
    return np.asarray((size / largest) ** 2)


def _determinant(matrices: Complexes) -> Complexes:
    return np.asarray(matrices[:, 0, 0] * matrices[:, 1, 1] - matrices[:, 0, 1] * matrices[:, 1, 0])


def _inverse(matrices: Complexes) -> Complexes:
    """Inverses of matrices of two rows and columns."""
    found = np.empty_like(matrices)
    found[:, 0, 0], found[:, 1, 1] = matrices[:, 1, 1], matrices[:, 0, 0]
    found[:, 0, 1], found[:, 1, 0] = -matrices[:, 0, 1], -matrices[:, 1, 0]
    return np.asarray(found / _determinant(matrices)[:, None, None])


def _moved(plant: WholePlant) -> WholePlant:
    """The plant without the states that its commands do not reach, and without disturbance and noise."""
    s, axes = plant.system, plant.axes
    r = reachable(s.A, s.B[:, :axes])
    part = lti.StateSpace(s.A[np.ix_(r, r)], s.B[r, :axes], s.C[:, r], s.D[:, :axes])
    return replace(plant, system=part, disturbances=0)


def _response(system: lti.StateSpace, freq: Floats, period_s: float) -> Complexes:
    points = np.exp(2j * math.pi * freq * period_s)
    rows = lti.resolvent_rows(system.A[None], system.C[None], points)[0]
    return np.asarray(np.moveaxis(rows, 2, 0) @ system.B + system.D)


def closed_map(plant: WholePlant, system: lti.StateSpace) -> Floats:
    """Map of the states of plant and controller, their loop closed.

    Args:
        plant: The plant of all axes.
        system: A controller from the optical errors to the commands.
    """
    s, axes = plant.system, plant.axes
    command, seen = s.B[:, :axes], s.C[axes:]
    return np.block([[s.A + command @ system.D @ seen, command @ system.C], [system.B @ seen, system.A]])


def whole_margins(plant: WholePlant, controller: WholeController) -> WholeMargins:
    """Margins of the loop of all axes, on frequencies that show every resonance of plant, controller and loop.

    Args:
        plant: The plant of all axes.
        controller: Its controller.

    Raises:
        ValueError: The loop is unstable.
    """
    moved, system = _moved(plant), controller.system
    poles = [np.linalg.eigvals(A).astype(complex) for A in (moved.system.A, system.A, closed_map(moved, system))]
    if np.max(np.abs(poles[-1])) >= 1.0:
        raise ValueError(f"the loop under {controller.name!r} is unstable with all axes closed; lower its gains")
    freq = resolving(np.concatenate(poles), plant.period_s)
    returned = _returned(moved, system, freq)
    least = least_moduli(moved, system, freq, returned, poles[-1])
    margin = multiloop_disk_margin(freq, returned - np.eye(plant.axes))
    return WholeMargins(float(np.min(least)), margin, bandwidth_hz(freq, np.sqrt(least_squares(returned))))


def _misfit(plant: WholePlant, controller: WholeController) -> None:
    s = controller.system
    if not all(np.isfinite(matrix).all() for matrix in (s.A, s.B, s.C, s.D)):
        raise ValueError(f"controller {controller.name!r} holds a number that is not finite")


ALL_AXES = Scope(WholeJudge, _misfit, whole_margins)


def side_by_side(name: str, each: Sequence[AxisController]) -> WholeController:
    """Controllers of one axis, one for each, as one of all axes.

    Args:
        name: What it is called.
        each: The controllers, in the order of the axes.
    """
    from scipy.linalg import block_diag

    parts = ((c.system.A, c.system.B[:, :1], c.system.C, c.system.D[:, :1], c.anti_windup) for c in each)
    A, B, C, D, windup = (np.asarray(block_diag(*blocks), dtype=float) for blocks in zip(*parts, strict=True))
    return WholeController(name, lti.StateSpace(A, B, C, D), windup)


def alone(plant: WholePlant, axis: int) -> DesignPlant:
    """One axis as its controller sees it while the other commands rest.

    Args:
        plant: The plant of all axes.
        axis: Number of the axis, from 0.
    """
    s, axes = plant.system, plant.axes
    rows, own = [axis, axes + axis], axes + plant.disturbances + axis
    others = [i for i in range(axes, s.B.shape[1]) if i != own]
    columns = [axis, *others, own]  # this axis's optical noise stands last, before that of no gauge
    B, D = np.pad(s.B[:, columns], ((0, 0), (0, 1))), np.pad(s.D[np.ix_(rows, columns)], ((0, 1), (0, 1)))
    system = lti.StateSpace(s.A, B, np.vstack([s.C[rows], np.zeros((1, s.order))]), D)
    return DesignPlant(plant.period_s, system, len(others), plant.gain_rad_v, True, False)
