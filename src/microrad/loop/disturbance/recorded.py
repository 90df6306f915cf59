"""A recorded motion of one axis: what is static of it, what drifts, and the rest at another step without folding."""

import math
from dataclasses import dataclass
from fractions import Fraction

import numpy as np
from numpy.typing import ArrayLike

from microrad.core.arrays import Floats, reals
from microrad.core.units import counted
from microrad.loop.disturbance.records import above_zero

PASSED = 0.9
"""Share of half of the lower of two rates up to which a resampled motion is what it was; at the half it has ended."""

LEAST_SAMPLES = 200
"""Samples of a recording below which nothing is told of its spectrum."""

_STOPPED_DB = 80.0  # of what lies above half of the new rate, and of the images of what lies below half of the old one
_SAME_RATE = 1e-9  # rates that differ by less are one
_CLOCK = 1e-7  # by which a ratio of two rates may be off for smaller whole numbers; clocks differ by more
_MOST_APART = 1e4  # ratio of two rates
_MOST_STEPS = 50_000_000

PARTS = 8
"""Lengths of a segment of the density in a recording."""


@dataclass(frozen=True, slots=True, eq=False)
class RecordedMotion:
    """A motion of one axis at even steps: mean + slope (t - middle) + rest, by least squares.

    ``mean_rad`` is a static misalignment and ``slope_rad_s`` a slow drift, as far as a recording of this length tells
    them from slow motion.
    """

    name: str
    samples_rad: Floats
    step_s: float
    mean_rad: float
    slope_rad_s: float

    @property
    def duration_s(self) -> float:
        """From the first sample to the last."""
        return (self.samples_rad.size - 1) * self.step_s

    @property
    def half_rate_hz(self) -> float:
        """Half of the sample rate: faster motion is not in the recording."""
        return 0.5 / self.step_s

    @property
    def rest_rad(self) -> Floats:
        """The samples without mean and drift."""
        return np.asarray(
            self.samples_rad - self.trend_rad(self.step_s * np.arange(self.samples_rad.size, dtype=float))
        )

    def trend_rad(self, time_s: Floats) -> Floats:
        """Mean and drift alone at some times (s) from the first sample on."""
        return np.asarray(self.mean_rad + self.slope_rad_s * (time_s - 0.5 * self.duration_s))


def recorded_motion(samples_rad: ArrayLike, step_s: float, name: str = "recording") -> RecordedMotion:
    """A recorded motion with its mean and slope.

    Args:
        samples_rad: The motion (rad), evenly sampled, shape (samples,) with 200 samples or more.
        step_s: Between two samples (s), above 0.
        name: What it is called.

    Raises:
        ValueError: For another shape, too few samples, a sample that is no number, and a motion that stands still.
    """
    samples = reals(samples_rad, f'"{name}"')
    above_zero(step_s, f'the step of "{name}"', "s")
    if samples.ndim != 1 or samples.size < LEAST_SAMPLES:
        raise ValueError(
            f'"{name}" has the shape {samples.shape}: give one row of {LEAST_SAMPLES} samples or more, in rad'
        )
    bad = np.flatnonzero(~np.isfinite(samples))
    if bad.size:
        raise ValueError(
            f'"{name}": sample {bad[0]} is {samples[bad[0]]}, {counted(bad.size, "such sample")} in all; cut the '
            "recording to a part without them: a gap that is filled in is no motion that was measured"
        )
    if np.ptp(samples) <= 1e-12 * float(np.max(np.abs(samples))):
        raise ValueError(f'"{name}" stands still at {samples[0]:g} rad; name a channel that moves')
    time: Floats = step_s * (np.arange(samples.size, dtype=float) - 0.5 * (samples.size - 1))
    mean = float(np.mean(samples))
    return RecordedMotion(name, samples, step_s, mean, float(time @ (samples - mean) / (time @ time)))


def resampled(motion: RecordedMotion, step_s: float) -> Floats:
    """The motion (rad) at multiples of another step from its first sample on, as long as the recording lasts.

    Behind a low pass with a linear phase (Kaiser window): what lies above half of the lower of both rates is down by
    80 dB, and what lies below 0.9 of that half is as it was. Mean and drift are kept exactly. At its own step the
    motion is returned as it is.

    Args:
        motion: The recorded motion.
        step_s: The step (s), above 0.

    Raises:
        ValueError: For a step that is ten thousand times longer or shorter, and where it makes 50 million samples.
    """
    from scipy.signal import firwin, kaiserord, resample_poly

    above_zero(step_s, "the step of a resampled motion", "s")
    ratio = motion.step_s / step_s
    if abs(ratio - 1.0) <= _SAME_RATE:
        return motion.samples_rad
    if not 1.0 / _MOST_APART <= ratio <= _MOST_APART or motion.samples_rad.size * ratio > _MOST_STEPS:
        raise ValueError(
            f'"{motion.name}": {motion.samples_rad.size} samples, {motion.step_s:g} s apart, are not played every '
            f"{step_s:g} s: rates may differ {_MOST_APART:g} times, and {_MOST_STEPS} steps are the most; cut the "
            "recording"
        )
    share = _in_whole_numbers(ratio)
    up, down = share.numerator, share.denominator
    faster = max(up, down)
    taps, beta = kaiserord(_STOPPED_DB, (1.0 - PASSED) / faster)
    low_pass = firwin(taps | 1, 0.5 * (1.0 + PASSED) / faster, window=("kaiser", beta))
    count = math.floor(motion.duration_s / step_s * (1.0 + _SAME_RATE)) + 1
    rest = resample_poly(motion.rest_rad, up, down, window=low_pass)[:count]
    return np.asarray(rest + motion.trend_rad(step_s * np.arange(rest.size, dtype=float)))


def _in_whole_numbers(ratio: float) -> Fraction:
    """A ratio of two rates as one of small whole numbers."""
    turned = ratio < 1.0
    given = Fraction(1.0 / ratio if turned else ratio)
    found = given
    for most in (10, 100, 1000, 10_000):
        found = given.limit_denominator(most)
        if abs(float(found / given) - 1.0) <= _CLOCK:
            break
    return 1 / found if turned else found


def edge_s(motion: RecordedMotion, step_s: float) -> float:
    """How far from its ends (s) a resampled motion lacks samples on one side; 0 at the motion's own step.

    Args:
        motion: The recorded motion.
        step_s: The step that it is resampled to (s).
    """
    if abs(motion.step_s / step_s - 1.0) <= _SAME_RATE:
        return 0.0
    half_taps = (_STOPPED_DB - 7.95) / (2.285 * math.pi * (1.0 - PASSED)) / 2.0  # Kaiser's estimate
    return (half_taps + 1.0) * max(motion.step_s, step_s)


def density(rest_rad: Floats, step_s: float, parts: int = PARTS) -> tuple[Floats, Floats, int]:
    """Welch's one-sided density: equal segments, half overlapping, under Hann windows.

    Args:
        rest_rad: The motion (rad) without mean and drift, shape (samples,).
        step_s: Between two samples (s).
        parts: Lengths of a segment in the motion.

    Returns:
        Frequencies (Hz), densities (rad^2/Hz), and the number of segments.
    """
    from scipy.signal import welch

    length = rest_rad.size // parts
    freq, found = welch(rest_rad, 1.0 / step_s, nperseg=length, detrend=False)
    return np.asarray(freq), np.asarray(found), (rest_rad.size - length // 2) // (length - length // 2)


def beyond_rms(motion: RecordedMotion, freq_hz: float) -> float:
    """Rms (rad) of what a recorded motion has above a frequency.

    Args:
        motion: The recorded motion.
        freq_hz: The frequency (Hz).
    """
    freq, power, _ = density(motion.rest_rad, motion.step_s)
    return math.sqrt(float(np.sum(power[freq > freq_hz])) * float(freq[1]))
