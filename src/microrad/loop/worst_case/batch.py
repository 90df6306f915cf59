"""Linear figures of one loop on many mirrors at once: residual by error index, modulus margin, and slowest pole."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from microrad.core import lti
from microrad.core.arrays import Complexes, Floats
from microrad.core.threads import in_threads
from microrad.loop.control import dips
from microrad.loop.control.analysis import around_poles
from microrad.loop.coupled_study.whole import least_squares
from microrad.loop.disturbance.windows import ErrorIndex
from microrad.loop.pointing_loop.design import read_each_sample, sampled_mirrors
from microrad.loop.pointing_loop.linear import close, straightened
from microrad.loop.pointing_loop.loop import LoopController, PointingLoop
from microrad.loop.pointing_loop.windows import windowed_in_all

AT_ONCE = 64
"""Mirrors whose matrices are worked on at once: what a processor keeps near."""

AROUND = 3.0
"""Factor between distances of frequencies from a pole: close enough for dips that are followed."""

CLOSER = (0.25, 0.06, 0.015, 0.003)
"""Half widths, over the grid's step, of the parabolas by which a dip is followed: to some 1e-12 of it."""

LIGHT = 0.2
"""Damping below which a pole of the closed loop may hide a dip between two frequencies of the grid."""


@dataclass(frozen=True, slots=True, eq=False)
class Figures:
    """What a loop is on some mirrors, one row for each.

    ``rms_rad`` (mirrors, indices) is what each error index takes of the stationary error, rms over all axes, and
    ``modulus`` (mirrors,) the modulus margin; infinite and 0 where the loop is unstable. ``pole`` (mirrors,) is the
    largest |z| over a control sample.
    """

    rms_rad: Floats
    modulus: Floats
    pole: Floats

    @property
    def unstable(self) -> int:
        """On how many of the mirrors the loop is unstable."""
        return int(np.sum(self.pole >= 1.0))


def figures(
    loop: PointingLoop,
    controller: LoopController,
    mirrors: Sequence[lti.StateSpace],
    indices: Sequence[ErrorIndex],
    threads: int | None = None,
) -> Figures:
    """The figures of a loop on many linear mirrors, under one controller.

    They do not depend on the threads. The margin is that of `control.loop_margins`, or with several axes the least
    singular value of 1 + L at the optical sensor.

    Args:
        loop: The loop on the mirror that the controller is designed for, whose inverse a controller may have.
        controller: The controller of all its axes.
        mirrors: Mirrors of the size of the loop's own, continuous, with a gain in place of each hysteresis element.
        indices: What counts of the error.
        threads: Threads to share them, by default one for each core.

    Raises:
        ValueError: A time of an index is less than half of the time between two readings.
    """
    fixed = straightened(controller, loop)
    margins = Margins(loop, fixed)
    parts = [mirrors[first : first + AT_ONCE] for first in range(0, len(mirrors), AT_ONCE)]
    jobs = [partial(_together, loop, fixed, margins, part, indices) for part in parts]
    found = in_threads(jobs, workers=threads)
    names = ("rms_rad", "modulus", "pole")
    return Figures(*(np.concatenate([getattr(each, name) for each in found]) for name in names))


def _together(
    loop: PointingLoop,
    controller: LoopController,
    margins: "Margins",
    mirrors: Sequence[lti.StateSpace],
    indices: Sequence[ErrorIndex],
) -> Figures:
    stack = _stacked(mirrors)
    closed = close(loop, controller, stack)
    poles = closed.poles
    size = np.max(np.abs(poles), axis=-1) ** (1.0 / len(closed.samples))
    rms, modulus = np.full((len(mirrors), len(indices)), math.inf), np.zeros(len(mirrors))
    stable = np.flatnonzero(size < 1.0)
    if 0 < stable.size < size.size:
        stack = lti.StateSpace(*(getattr(stack, key)[stable] for key in "ABCD"))
        closed = close(loop, controller, stack)
    if stable.size:
        squares = [np.sum(windowed_in_all(closed, index), axis=-1) for index in indices]
        rms[stable] = np.sqrt(np.maximum(np.stack(squares, axis=-1), 0.0))
        each_sample = loop.optical.every == 1
        modulus[stable] = margins.least(stack, poles[stable] if each_sample else margins.poles(stack))
    return Figures(rms, modulus, size)


def _stacked(systems: Sequence[lti.StateSpace]) -> lti.StateSpace:
    return lti.StateSpace(*(np.stack([getattr(s, key) for s in systems]) for key in "ABCD"))


class Margins:
    """Modulus margins of a loop on any mirrors, from responses of its controller that are computed once."""

    def __init__(self, loop: PointingLoop, controller: LoopController) -> None:
        """Choose a grid of frequencies that shows every resonance of the loop on its own mirror.

        Args:
            loop: The loop; a sensor slower than the control counts as in `design_plant`.
            controller: The controller of all its axes, without an inverse.
        """
        self._loop, s, axes = read_each_sample(loop), controller.system, loop.axes
        self._controller, self._period = controller, loop.timing.period_s
        used = np.any(s.B != 0.0, axis=0) | np.any(s.D != 0.0, axis=0)
        optical, gauge = used[:axes].any(), used[axes : axes + loop.mirror.axes].any()
        self._cuts = [_at_optical] * bool(optical) + [_at_commands] * bool(gauge)
        self._readings = axes + loop.mirror.axes * bool(gauge)
        own = _stacked([loop.mirror.linear_loop])
        poles = np.concatenate([np.linalg.eigvals(self._plants(own).A).ravel(), np.linalg.eigvals(s.A)])
        parts = [np.geomspace(1e-5, 0.5, 160) / self._period, np.linspace(0.0, 0.5, 101)[1:] / self._period]
        near = around_poles(poles, self._period, AROUND) * (1.0 + 1e-9)  # an undamped one has no response
        self._freq = np.unique(np.concatenate([*parts, near]))
        self._answers = self._response(self._freq)

    def _plants(self, mirrors: lti.StateSpace) -> lti.StateSpace:
        """From commands to the readings that the controller takes."""
        s = sampled_mirrors(self._loop, mirrors)
        return lti.StateSpace(s.A, s.B, s.C[..., : self._readings, :], s.D[: self._readings])

    def poles(self, mirrors: lti.StateSpace) -> Complexes:
        """Poles of the closed loops on a stack of mirrors, shape (mirrors, poles)."""
        return close(self._loop, self._controller, mirrors).poles

    def least(self, mirrors: lti.StateSpace, poles: Complexes) -> Floats:
        """Modulus margin on each of a stack of mirrors, shape (mirrors,); 0 where the loop is unstable.

        Minima are followed as `dips` says; so is each light resonance of the closed loop, whose dip may lie between two
        frequencies of the grid.

        Args:
            mirrors: The stack.
            poles: What `poles` gives for it.
        """
        plants, freq = self._plants(mirrors), self._freq
        rows = np.moveaxis(lti.resolvent_rows(plants.A, plants.C, self._points(freq)), 3, 1)
        G, axes = rows @ plants.B[:, None], self._loop.axes
        squared = [_least_squares(cut(self._answers, G, axes)) for cut in self._cuts]
        least = np.min(squared, axis=(0, 2))
        light = _light(poles, self._period)
        for cut, distance in zip(self._cuts, squared, strict=True):
            each = dips.on_grid(distance, freq)
            near = each.squared < dips.NEAR_LEAST**2 * least[each.row]
            seen = _seen_by(freq, light)
            row, where, width = (
                np.concatenate(pair)
                for pair in zip(
                    (each.row[near], each.freq_hz[near], each.width_hz[near]), (of[~seen] for of in light), strict=True
                )
            )
            found = dips.followed(partial(self._squared, cut, plants, row), where, width, CLOSER)
            np.minimum.at(least, row, found)
        return np.where(np.max(np.abs(poles), axis=-1) < 1.0, np.sqrt(np.maximum(least, 0.0)), 0.0)

    def _squared(self, cut: "_Cut", plants: lti.StateSpace, row: NDArray[np.intp], freq_hz: Floats) -> Floats:
        """Squares of the distance on plants, one for each row of frequencies."""
        K = self._response(freq_hz.ravel()).reshape(*freq_hz.shape, *self._answers.shape[1:])
        resolvent = self._points(freq_hz)[..., None, None] * np.eye(plants.A.shape[-1]) - plants.A[row, None]
        driven = np.broadcast_to(plants.B[row, None], (*freq_hz.shape, *plants.B.shape[1:]))
        return _least_squares(cut(K, plants.C[row, None] @ np.linalg.solve(resolvent, driven), self._loop.axes))

    def _response(self, freq_hz: Floats) -> Complexes:
        """Of the controller from readings to commands, shape (frequencies, actuators, readings)."""
        s, readings = self._controller.system, self._readings
        rows = lti.resolvent_rows(s.A[None], s.C[None], self._points(freq_hz))[0]
        return np.asarray(np.moveaxis(rows, 2, 0) @ s.B[:, :readings] + s.D[:, :readings])

    def _points(self, freq_hz: Floats) -> Complexes:
        return np.asarray(np.exp(2j * math.pi * self._period * freq_hz))


_Cut = Callable[[Complexes, Complexes, int], Complexes]


def _at_optical(K: Complexes, G: Complexes, axes: int) -> Complexes:
    """1 + L of the loop cut at the optical sensor, that of the gauge closed."""
    optical, gauge = K[..., :axes], K[..., axes:]
    if not gauge.shape[-1]:
        return np.asarray(np.eye(axes) - G @ optical)
    closed = np.eye(K.shape[-2]) - gauge @ G[..., axes:, :]
    through = np.linalg.solve(closed, np.broadcast_to(optical, (*closed.shape[:-1], axes)))
    return np.asarray(np.eye(axes) - G[..., :axes, :] @ through)


def _at_commands(K: Complexes, G: Complexes, axes: int) -> Complexes:
    """1 + L of the loop cut at the commands, all sensors at once."""
    return np.asarray(np.eye(K.shape[-2]) - K @ G)


def _least_squares(matrices: Complexes) -> Floats:
    """Squares of least singular values, one for each matrix."""
    size = matrices.shape[-1]
    if size == 1:
        return np.asarray(np.abs(matrices[..., 0, 0]) ** 2)
    if size == 2:
        return least_squares(matrices.reshape(-1, 2, 2)).reshape(matrices.shape[:-2])
    return np.asarray(np.linalg.svd(matrices, compute_uv=False)[..., -1] ** 2)


def _light(poles: Complexes, period_s: float) -> tuple[NDArray[np.intp], Floats, Floats]:
    """Row, frequency and half width (Hz) of light poles below half the rate, of a stack of loops."""
    kept = np.abs(poles) > 0.1
    s = np.log(np.where(kept, poles, 1.0)) / (2.0 * math.pi * period_s)
    row, at = np.nonzero(kept & (s.imag > 0.0) & (-s.real < LIGHT * np.abs(s)) & (s.imag < 0.499 / period_s))
    found = s[row, at]
    return row, found.imag, np.maximum(-found.real, 1e-9 / period_s)


def _seen_by(freq_hz: Floats, light: tuple[NDArray[np.intp], Floats, Floats]) -> NDArray[np.bool_]:
    """Which resonances are wider than the steps of the grid about them."""
    _, at, half = light
    places = np.clip(np.searchsorted(freq_hz, at), 1, freq_hz.size - 2)
    return np.asarray(half >= 0.5 * (freq_hz[places + 1] - freq_hz[places - 1]))
