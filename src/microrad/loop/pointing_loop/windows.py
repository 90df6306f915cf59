"""The error of the linear loop in time windows, by source: `disturbance.windows` for the sampled loop, exactly.

A window is a whole number of readings of the optical sensor, and a mean in it is that of all its plant steps. The sums
ride along as states; the map of N readings and what noise adds in them come from doubling, so that a window may be as
long as it likes.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from microrad.core.arrays import Floats
from microrad.loop.disturbance.windows import ErrorIndex, rational_rms, windowed_rms
from microrad.loop.pointing_loop.linear import (
    ClosedLoop,
    Line,
    Noise,
    noise_of,
    noise_of_all,
    refuse_unstable,
    start_of,
    turning,
)
from microrad.loop.pointing_loop.loop import PointingLoop

_STILL = 1e-12  # turn in a reading of a line that is at a multiple of its rate


@dataclass(frozen=True, slots=True)
class _Span:
    """States and sums over some readings: s -> F s + noise of covariance Q; the sums stand behind the states."""

    F: Floats
    Q: Floats

    def then(self, later: "_Span") -> "_Span":
        return _Span(later.F @ self.F, later.F @ self.Q @ later.F.mT + later.Q)

    def times(self, count: int) -> "_Span":
        made, doubled = _Span(np.eye(self.F.shape[-1]), np.zeros_like(self.Q)), self
        while count:
            made, count = (made.then(doubled), count - 1) if count % 2 else (made, count)
            doubled, count = doubled.then(doubled), count // 2
        return made


def windowed(closed: ClosedLoop, index: ErrorIndex) -> dict[str, Floats]:
    """Variance that an index takes of the stationary error, by the name of its source, per axis (rad^2), lines too.

    Args:
        closed: The loop under its controller.
        index: What counts of the error; its times are rounded to whole readings of the optical sensor.

    Raises:
        ValueError: The loop is unstable, or a time of the index is less than half of the time between two readings.
    """
    refuse_unstable(closed)
    found = _by_source(closed, index)
    for name, variance in _by_line(closed, index):
        found[name] = found.get(name, 0.0) + variance
    return found


def windowed_noise(closed: ClosedLoop, index: ErrorIndex) -> dict[str, Floats]:
    """The same of the noises alone, which are Gaussian.

    Args:
        closed: The loop under its controller.
        index: What counts of the error.

    Raises:
        ValueError: As `windowed`.
    """
    refuse_unstable(closed)
    return _by_source(closed, index)


def _by_source(closed: ClosedLoop, index: ErrorIndex) -> dict[str, Floats]:
    window, apart = readings_of(closed.open.loop, index)
    found: dict[str, Floats] = {}
    for source in closed.sources:
        left = _noise(closed, noise_of(closed, source), index, window, apart)
        found[source.name] = found.get(source.name, 0.0) + left
    return found


def windowed_lines(closed: ClosedLoop, index: ErrorIndex) -> list[tuple[str, Floats]]:
    """The same of each spectral line, with its name; a line of an axis stands there, and is zero on the others.

    Args:
        closed: The loop under its controller.
        index: What counts of the error.

    Raises:
        ValueError: As `windowed`.
    """
    refuse_unstable(closed)
    return _by_line(closed, index)


def _by_line(closed: ClosedLoop, index: ErrorIndex) -> list[tuple[str, Floats]]:
    window, apart = readings_of(closed.open.loop, index)
    return [(line.name, _line(closed, line, index, window, apart)) for line in closed.open.lines]


def windowed_in_all(closed: ClosedLoop, index: ErrorIndex, *, at_samples: bool = False) -> Floats:
    """Variance that an index takes of the stationary error, of all sources together, per axis (rad^2), lines too.

    Args:
        closed: The loop under its controller, or a stack of loops; each of them stable, which is not looked at.
        index: What counts of the error, as for `windowed`.
        at_samples: Whether the error is looked at where each control sample ends alone, and not at all plant steps.

    Raises:
        ValueError: A time of the index is less than half of the time between two readings.
    """
    window, apart = readings_of(closed.open.loop, index)
    found = _noise(closed, noise_of_all(closed), index, window, apart, at_samples=at_samples)
    for line in closed.open.lines:
        found = found + _line(closed, line, index, window, apart, at_samples=at_samples)
    return found


def readings_of(loop: PointingLoop, index: ErrorIndex) -> tuple[int, int]:
    """Window and spacing of an index in whole readings of the optical sensor; 0 for a time that it has not.

    Args:
        loop: The loop, for its clock.
        index: What counts of the error.

    Raises:
        ValueError: A time of the index is less than half of the time between two readings.
    """
    return _readings(loop, index, "window_s"), _readings(loop, index, "spacing_s")


@dataclass(frozen=True, slots=True)
class WindowedErrors:
    """What an index takes of a loop's errors, by source: radial rms (rad).

    ``before`` has the disturbances as they are, ``rational`` their sum by the rational form of the weight, nan where
    there is none, and ``left`` every source of the linear loop's error.
    """

    index: ErrorIndex
    before: dict[str, float]
    rational: float
    left: dict[str, float]


def windowed_errors(closed: ClosedLoop, indices: Sequence[ErrorIndex]) -> tuple[WindowedErrors, ...]:
    """What each index takes of the disturbances of a loop, and of the error that is left.

    Args:
        closed: The loop under its controller.
        indices: What counts.

    Raises:
        ValueError: As for `windowed`.
    """
    found = []
    for index in indices:
        left = {name: math.sqrt(max(float(np.sum(each)), 0.0)) for name, each in windowed(closed, index).items()}
        squares: dict[str, float] = {}
        rational = 0.0
        for each in (motion for axis in closed.open.loop.disturbances for motion in axis):
            squares[each.name] = squares.get(each.name, 0.0) + windowed_rms(each, index) ** 2
            rational += math.nan if index.spacing_s else rational_rms(each, index) ** 2
        before = {name: math.sqrt(square) for name, square in squares.items()}
        found.append(WindowedErrors(index, before, math.sqrt(rational), left))
    return tuple(found)


def _readings(loop: PointingLoop, index: ErrorIndex, name: str) -> int:
    seconds: float | None = getattr(index, name)
    period = loop.timing.period_s * loop.optical.every
    if seconds is None:
        return 0
    if not round(seconds / period):
        raise ValueError(f"{name} of {index.kind} is {seconds:g} s, and the sensor reads every {period:g} s: give more")
    return round(seconds / period)


def _every(closed: ClosedLoop, *, at_samples: bool) -> int:
    """Plant steps from one that the error is looked at to the next."""
    return len(closed.steps) if at_samples else 1


def _looks(closed: ClosedLoop, every: int) -> int:
    """How often the error is looked at from one reading to the next."""
    return len(closed.samples) * len(closed.steps) // every


def _noise(
    closed: ClosedLoop, added: Noise, index: ErrorIndex, window: int, apart: int, *, at_samples: bool = False
) -> Floats:
    """Variance of what one noise leaves, per axis."""
    o, every = closed.open, _every(closed, at_samples=at_samples)
    start, whole = start_of(closed, added)
    if every > 1:
        whole = _at_samples(closed, added, start)
    if not window:
        return whole
    states, axes = start.shape[-1], len(o.error)
    error = np.hstack([o.error, np.zeros((axes, states - o.at.order))])
    sampled, stepped = added
    summed = _Span(np.eye(states + axes), np.zeros((states + axes,) * 2))
    for sample, noise in zip(closed.samples, sampled, strict=True):
        summed = summed.then(_moved(sample, noise, np.zeros_like(error)))
        for number, step in enumerate(closed.steps, 1):
            summed = summed.then(_moved(step, stepped, np.zeros_like(error) if number % every else error))
    still = _signed(summed, axes, 0.0)
    if index.spacing_s is None:
        of_all = summed.times(window)
    else:
        both = min(window, apart)  # of windows that overlap, what they share is not in the difference
        of_all = summed.times(both).then(still.times(abs(apart - window))).then(_signed(summed, axes, -1.0).times(both))
    begun = np.zeros((*start.shape[:-2], states + axes, states + axes))
    begun[..., :states, :states] = start
    ended = (of_all.F @ begun @ of_all.F.mT + of_all.Q)[..., states:, states:]
    mean = np.diagonal(ended, axis1=-2, axis2=-1) / (window * _looks(closed, every)) ** 2
    return np.asarray(whole - mean if index.takes == "RPE" else mean)


def _at_samples(closed: ClosedLoop, added: Noise, start: Floats) -> Floats:
    """Variance of the error where the control samples end, per axis, from the states' before a sensor period."""
    o, (sampled, stepped) = closed.open, added
    P, found = start, []
    for sample, noise in zip(closed.samples, sampled, strict=True):
        P = sample @ P @ sample.mT + noise @ noise.mT
        for step in closed.steps:
            P = step @ P @ step.mT + stepped @ stepped.T
        head = P[..., : o.at.order, : o.at.order]
        found.append(np.einsum("ij,...jk,ik->...i", o.error, head, o.error))
    return np.asarray(np.mean(found, axis=0))


def _moved(matrix: Floats, noise: Floats, error: Floats) -> _Span:
    """One map of the states with its noise; the error behind it is added to the sums."""
    axes, states = error.shape
    F = np.zeros((*matrix.shape[:-2], states + axes, states + axes))
    F[..., :states, :states], F[..., states:, :states] = matrix, error @ matrix
    F[..., states:, states:] = np.eye(axes)
    into = np.concatenate([noise, error @ noise], axis=-2)
    return _Span(F, into @ into.mT)


def _signed(span: _Span, axes: int, sign: float) -> _Span:
    """The same with what it adds to the sums times a sign; 0 leaves them as they are."""
    keep = np.ones(span.F.shape[-1])
    keep[-axes:] = sign
    F, Q = span.F * keep[:, None], span.Q * np.outer(keep, keep)
    F[..., -axes:, -axes:] = np.eye(axes)
    return _Span(F, Q)


def _line(
    closed: ClosedLoop, line: Line, index: ErrorIndex, window: int, apart: int, *, at_samples: bool = False
) -> Floats:
    """Variance over the phase of what one line leaves, per axis: what turns adds up to a geometric series."""
    every = _every(closed, at_samples=at_samples)
    errors, z = turning(closed, line)
    errors = errors[every - 1 :: every]
    whole = np.asarray(np.mean(0.5 * np.abs(errors) ** 2, axis=0))
    if not window:
        return whole
    series = window if abs(1.0 - z) < _STILL else (1.0 - z**window) / (1.0 - z)
    mean = series * np.sum(errors, axis=0) / (window * _looks(closed, every))
    if index.spacing_s is not None:
        mean = mean * (1.0 - z**apart)
    variance = np.asarray(0.5 * np.abs(mean) ** 2)
    return whole - variance if index.takes == "RPE" else variance
