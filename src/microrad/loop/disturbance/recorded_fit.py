"""A recorded motion as a disturbance: its lines, a shaping filter of the rest, and how far that can be believed."""

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from microrad.core.arrays import Floats
from microrad.core.units import plain
from microrad.loop.disturbance.recorded import PARTS, RecordedMotion, density, recorded_motion
from microrad.loop.disturbance.recorded_lines import find_lines
from microrad.loop.disturbance.recorded_tests import (
    Stationarity,
    Whiteness,
    correlation_s,
    one_step_residual,
    stationarity,
    whiteness,
)
from microrad.loop.disturbance.records import Disturbance, one_input, psd
from microrad.loop.disturbance.sources import from_terms
from microrad.loop.disturbance.terms import Samples, cost, fit_terms, states_of, with_states

FITTED = 0.8
"""Share of half of the sample rate up to which a spectrum is fitted: above it stands the filter against folding."""

_BROAD = 0.05  # rows of the density closer than this fraction of their frequency are averaged
_SURE = 0.015  # relative standard error of a row's density below which all rows count alike
_TOLD = 0.1  # above it a row tells nothing of how well the filter fits
_SLOW = 0.6  # the same below the segments' first frequencies, in three rows
_FIRST_BIN = 2  # of the segments; below it the window still sees what was detrended
_LEAST_DAMPING = 0.005  # a resonance that rows of 5 % show
_BY_CHANCE = 1.2  # mean squared misfit of the rows, over its expectation, up to which a fit is as good as any
_FEW = 2  # states of such a fit for which no leaner one is looked for
_WELL = 0.05  # misfit of a row (natural logarithm), in units of which it is that of chance
_FOLDED = 2  # multiples of the sample rate whose folding is taken one by one
_BEYOND = 2.0 * (math.pi**2 / 6.0 - 1.0 - 0.25) * (_FOLDED + 1) ** 2  # all further ones, as 1/f^2 at the next
_MOST_STATES = 24


@dataclass(frozen=True, slots=True, eq=False)
class RecordedFit:
    """A recorded motion as a disturbance of one axis, and what speaks for it.

    ``disturbance`` has the lines and the shaping filter, of ``order`` states, without mean and slope, which are those
    of ``motion``. ``band_limited`` says that the samples were taken behind a filter against folding. ``worst_db`` is
    the largest ratio of the fitted density to the recorded one, in decibels of power, near ``worst_at_hz``, among the
    rows that the recording tells to a tenth. ``correlation_s`` is the time after which the motion without its lines has
    forgotten all but 1/e.
    """

    motion: RecordedMotion
    disturbance: Disturbance
    order: int
    band_limited: bool
    worst_db: float
    worst_at_hz: float
    correlation_s: float
    whiteness: Whiteness
    stationarity: Stationarity


def fit_recording(
    samples_rad: ArrayLike, step_s: float, *, order: int | None = None, name: str = "recording"
) -> RecordedFit:
    """Fit lines and a shaping filter to a recorded motion.

    Mean and slope are taken off by least squares, lines by `find_lines`, and the rest is Welch's density in rows of
    5 % of their frequency, each as sure as it is averaged, up to 0.8 of half of the sample rate. Sampling folds what is
    faster, unless a filter was before it: both are tried, and the one that fits better, or as well with fewer states,
    is taken.

    Args:
        samples_rad: The motion (rad), evenly sampled, shape (samples,) with 200 samples or more.
        step_s: Between two samples (s), above 0.
        order: States of the shaping filter, 1 to 24; by default as few as follow the density.
        name: What the disturbance is called; its random numbers go by it.

    Raises:
        ValueError: For samples that are no motion (see `recorded_motion`), for another order, and where no sum of a few
            filters follows the density.
    """
    motion = recorded_motion(samples_rad, step_s, name)
    if order is not None and not 1 <= order <= _MOST_STATES:
        raise ValueError(f'"{name}": a shaping filter of {order} states; give 1 to {_MOST_STATES}')
    lines, rest = find_lines(motion.rest_rad, step_s)
    range_hz = 2.0 / motion.duration_s, motion.half_rate_hz
    found = []
    measured = _measured(rest, motion)
    for folded in (True, False):
        samples, sure = _rows(*measured, motion, folded)
        terms = fit_terms(samples, range_hz, _LEAST_DAMPING, _WELL)
        terms = with_states(samples, terms, range_hz, _LEAST_DAMPING, order)
        misfit = samples.misfit(terms)
        off = np.where(sure, misfit / samples.trust, 0.0)
        worst = int(np.argmax(np.abs(off)))
        worst_db, at_hz = 10.0 * float(off[worst]) / math.log(10.0), float(samples.centre_hz[worst])
        found.append((cost(samples, terms), not folded, terms, worst_db, at_hz))
        if float(np.mean((misfit / _SURE) ** 2)) < _BY_CHANCE and states_of(terms) <= _FEW:
            break
    _, band_limited, terms, worst_db, at_hz = min(found, key=lambda each: each[:2])
    filtered, states = one_input(from_terms(terms, name, "", "recorded")), states_of(terms)
    basis = (
        f"fit of {states} states and {len(lines)} lines to {plain(motion.duration_s, 4)} s; worst {worst_db:+.2f} dB "
        f"near {plain(at_hz, 4)} Hz"
    )
    spectrum = _spectrum(filtered, motion, band_limited)
    residual = one_step_residual(spectrum, rest, step_s)
    return RecordedFit(
        motion,
        replace(filtered, lines=lines, basis=basis),
        states,
        band_limited,
        worst_db,
        at_hz,
        correlation_s(rest, step_s),
        whiteness(residual, states),
        stationarity(spectrum, rest, residual),
    )


def _spectrum(filtered: Disturbance, motion: RecordedMotion, band_limited: bool) -> Floats:
    """Density of the samples under a filter at the frequencies of their transform, up to those that are fitted."""
    count, rate = motion.samples_rad.size, 2.0 * motion.half_rate_hz
    freq = np.arange(math.floor(FITTED * (count // 2)) + 1) * rate / count
    grid = np.append(0.0, np.geomspace(0.1 * freq[1], freq[-1], 8000))
    S = psd(filtered, grid)
    if not band_limited:
        S = S + sum(psd(filtered, image) for image in _images(grid, rate))
        S = S + _BEYOND * psd(filtered, np.array([(_FOLDED + 1) * rate]))
    return np.asarray(np.exp(np.interp(freq, grid, np.log(S))))


def _measured(rest: Floats, motion: RecordedMotion) -> tuple[Floats, Floats, Floats, Floats]:
    """Centre (Hz), width (Hz), density and its relative standard error of rows, each of shape (rows,).

    Below the first frequencies of the segments they are of the periodogram of all of the recording.
    """
    slow, fast = (_averaged(*density(rest, motion.step_s, parts), below) for parts, below in ((1, PARTS), (PARTS, 0)))
    centre, width, wanted, error = (np.concatenate(both) for both in zip(slow, fast, strict=True))
    kept = centre <= FITTED * motion.half_rate_hz
    return centre[kept], width[kept], wanted[kept], error[kept]


def _rows(
    centre: Floats, width: Floats, wanted: Floats, error: Floats, motion: RecordedMotion, folded: bool
) -> tuple[Samples, NDArray[np.bool_]]:
    """The rows as `fit_terms` takes them, and whether each of them is sure to a tenth.

    ``folded`` rows hold what sampling folds into them.
    """
    own = centre[:, None] + 0.3 * width[:, None] * np.array([-1.0, 0.0, 1.0])
    rate = 2.0 * motion.half_rate_hz
    images = _images(centre, rate)
    further = np.column_stack([*images, np.full(centre.size, (_FOLDED + 1) * rate)])
    nodes = np.hstack([own, further]) if folded else own
    weights = np.tile(([1 / 3] * 3 + [1.0] * len(images) + [_BEYOND])[: nodes.shape[1]], centre.size)
    starts = np.arange(centre.size) * nodes.shape[1]
    trust, given = np.minimum(1.0, _SURE / error), np.zeros(centre.size, dtype=bool)
    sure = error <= max(_TOLD, float(np.min(error)))
    return Samples(nodes.ravel(), weights, starts, wanted, given, trust, centre), sure


def _images(freq: Floats, rate_hz: float) -> list[Floats]:
    """Frequencies that sampling folds onto these, one by one; those beyond are `_BEYOND` times the next."""
    return [abs(k * rate_hz + side * freq) for k in range(1, _FOLDED + 1) for side in (-1, 1)]


def _averaged(freq: Floats, power: Floats, segments: int, below: int) -> tuple[Floats, Floats, Floats, Floats]:
    """Centre, width, density and its relative standard error of rows of bins, up to ``below`` lowest bins where given.

    The logarithm of a mean of few is too low on average; its expectation (of chi-square) is put in its place.
    """
    from scipy.special import digamma

    used = slice(_FIRST_BIN + (1 if below else 0), _FIRST_BIN * below or None)
    step, power = float(freq[1]), np.maximum(power, 1e-12 * float(np.max(power)))  # rounding, below a converter's steps
    freq, power = freq[used], power[used]
    group = np.floor(np.log(freq / freq[0]) / (_BROAD if not below else _SLOW))
    starts = np.flatnonzero(np.diff(group, prepend=-1.0))
    sizes = np.diff(starts, append=freq.size)
    spread = (sizes + 2.0 * (sizes - 1) * (4 / 9) + 2.0 * np.maximum(sizes - 2, 0) / 36) / sizes**2  # of Hann's bins
    error = np.sqrt((1.0 if segments == 1 else 1.0556 / segments) * spread)  # of halves that overlap
    half = 1.0 / error**2
    wanted = np.add.reduceat(power, starts) / sizes * np.exp(np.log(half) - digamma(half))
    return np.add.reduceat(freq, starts) / sizes, (sizes - 1) * step, wanted, error
