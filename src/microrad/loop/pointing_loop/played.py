"""A recorded motion in the loop: played step by step as it is, and as the spectrum that was fitted to it.

Played, the motion stands at each plant step where the disturbances stand, and the loop starts from rest: the recursions
are those of `linear`. The loop's own disturbances and noises are left out. Fitted, the covariance is exact. Simulated,
the motion is played to the mirror with its hysteresis, limits and quantisation, straight between control samples.
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from microrad.core.arrays import Floats
from microrad.core.units import format_limit, format_quantity
from microrad.loop.disturbance import NO_REFERENCE, Disturbance, SampledReference, band_rms, psd
from microrad.loop.disturbance.recorded import beyond_rms, density, edge_s, resampled
from microrad.loop.disturbance.recorded_fit import RecordedFit
from microrad.loop.pointing_loop.ensemble import Span, simulate
from microrad.loop.pointing_loop.linear import ClosedLoop, close, refuse_unstable, stationary
from microrad.loop.pointing_loop.loop import LoopController, PointingLoop

AGREEMENT = 0.05
"""Difference of the two residuals, over the fitted one, above which a reason is looked for."""

_CORRELATIONS = 10.0  # that a recording has to hold beside what settles
_SLICE = 4096  # sensor periods at a time
_PARTS = 8
_BANDS_PER_OCTAVE = 3


@dataclass(frozen=True, slots=True)
class Played:
    """What the linear loop leaves of a recorded motion, from ``begin_s`` to ``end_s`` of it.

    ``rms_rad`` is about the mean of the error, ``mean_rad``, which static misalignment and drift leave. The rms of its
    eight equal parts lies between ``least_rms_rad`` and ``most_rms_rad``.
    """

    begin_s: float
    end_s: float
    mean_rad: float
    rms_rad: float
    least_rms_rad: float
    most_rms_rad: float


@dataclass(frozen=True, slots=True, eq=False)
class RecordedResidual:
    """What the loop of one axis leaves of a recorded motion.

    ``played`` is of the linear loop, ``fitted_rms_rad`` that of the fitted spectrum there, ``noise_rms_rad`` what the
    loop's sensors add to either. ``simulated_rms_rad`` is of the motion played to the mirror with its hysteresis.
    ``beyond_loop_rad`` is the rms of the recording above half of the plant's rate, which is not played;
    ``reason`` says why the two differ, "" where they do not.
    """

    played: Played
    fitted_rms_rad: float
    noise_rms_rad: float
    simulated_rms_rad: float
    beyond_loop_rad: float
    reason: str

    @property
    def difference(self) -> float:
        """Of the played residual from the fitted one, over that."""
        return self.played.rms_rad / self.fitted_rms_rad - 1.0


def refuse_short(fit: RecordedFit, settle_s: float) -> None:
    """Refuse a recording that ends before the loop has settled and ten of its correlation times are over.

    Args:
        fit: The recording.
        settle_s: What the loop takes to settle (s).

    Raises:
        ValueError: The recording is shorter.
    """
    needed = settle_s + _CORRELATIONS * fit.correlation_s
    if fit.motion.duration_s < needed:
        raise ValueError(
            f'"{fit.motion.name}" lasts {format_quantity(fit.motion.duration_s, "s", 3)}; the loop settles in '
            f"{format_quantity(settle_s, 's', 3)}, and ten times the {format_quantity(fit.correlation_s, 's', 3)} in "
            "which the motion forgets itself are needed behind that: record "
            f"{format_limit(needed, 's', 3, least=True)} or more"
        )


def play(closed: ClosedLoop, motion_rad: Floats, axis: int = 0) -> Floats:
    """Error (rad) of an axis at the plant steps of whole sensor periods, from rest, shape (steps,).

    Args:
        closed: A loop without disturbances under its controller.
        motion_rad: The motion of that axis at the plant steps, shape (steps + 1 or more,); the first one stands at
            time 0, and the first error is that at the end of the first step.
        axis: The axis.
    """
    o, whole = closed.open, closed.step_noise.shape[0]
    per_period = len(closed.samples) * len(closed.steps)
    now = o.at.errors.start + axis
    state, read = np.eye(whole, whole + per_period), list[Floats]()
    for sample in closed.samples:
        state = sample @ state
        for step in closed.steps:
            state = step @ state
            state[now, whole + len(read)] += 1.0
            read.append(state[now])
    over, into = np.hsplit(state, [whole])
    from_state, from_motion = np.hsplit(np.array(read), [whole])
    periods = (motion_rad.size - 1) // per_period
    moved = motion_rad[1 : 1 + periods * per_period].reshape(periods, per_period)
    error, x = np.empty((periods, per_period)), np.zeros(whole)
    x[now] = motion_rad[0]
    for begin in range(0, periods, _SLICE):
        some = moved[begin : begin + _SLICE]
        added, states = some @ into.T, np.empty((len(some), whole))
        for k, each in enumerate(added):
            states[k] = x
            x = over @ x + each
        error[begin : begin + _SLICE] = states @ from_state.T + some @ from_motion.T
    return error.ravel()


def recorded_residual(
    loop: PointingLoop, controller: LoopController, fit: RecordedFit, settle_s: float
) -> RecordedResidual:
    """What the loop leaves of a recorded motion: played, fitted and simulated.

    Args:
        loop: The loop of one axis; its own disturbances are left out.
        controller: Its controller.
        fit: The recording.
        settle_s: What is left out at the begin of the recording (s); at its ends, as much as resampling needs.

    Raises:
        ValueError: The loop is unstable, or the recording too short.
    """
    refuse_short(fit, settle_s)
    step = loop.timing.step_s
    still = close(replace(loop, disturbances=((),)), controller)
    refuse_unstable(still)
    moved = resampled(fit.motion, step)
    error = play(still, moved)
    edge = edge_s(fit.motion, step)
    begin, end = (round(each / step) for each in (max(settle_s, edge), fit.motion.duration_s - edge))
    kept = error[begin:end]
    played = _played(kept, begin * step, (begin + kept.size) * step)
    known = replace(fit.disturbance, lines=tuple(each for each in fit.disturbance.lines if each.freq_hz < 0.5 / step))
    theory = stationary(close(replace(loop, disturbances=((known,),)), controller)).error_by_source
    fitted = math.sqrt(float(theory[known.name][0]))
    noise = math.sqrt(sum(float(each[0]) for name, each in theory.items() if name != known.name))
    simulated = _simulated(loop, controller, moved, Span((begin + kept.size) * step, begin * step, 0))
    beyond = beyond_rms(fit.motion, 0.5 / step) if fit.motion.half_rate_hz > 0.5 / step else 0.0
    reason = ""
    if abs(played.rms_rad / fitted - 1.0) > AGREEMENT:
        trend = play(still, fit.motion.trend_rad(step * np.arange(moved.size, dtype=float)))
        missing = fitted**2 - played.rms_rad**2
        if float(np.var(trend[begin:end])) > -0.5 * missing > 0.0:
            reason = "drift, and what settles slowly behind the begin, are no part of the fit"
        else:
            reason = _reason(fit, known, moved[1:][begin:end], kept, step, missing)
    return RecordedResidual(played, fitted, noise, simulated, beyond, reason)


def _simulated(loop: PointingLoop, controller: LoopController, moved_rad: Floats, span: Span) -> float:
    """Rms (rad) about its mean of what the loop leaves of a motion on the mirror as it is, but for noises."""
    timing, gauge = loop.timing, loop.gauge
    quiet = replace(
        loop,
        disturbances=((),),
        references=(NO_REFERENCE,),
        optical=replace(loop.optical, noise_rad=0.0),
        gauge=None if gauge is None else replace(gauge, noise_rad=0.0),
        unknown=(SampledReference(moved_rad[:: timing.steps_per_sample], timing.period_s),),
    )
    run = simulate(quiet, controller, span, 1)
    return math.sqrt(float(run.rms_rad[0, 0] ** 2 - run.mean_rad[0, 0] ** 2))


def _played(error: Floats, begin_s: float, end_s: float) -> Played:
    length = error.size // _PARTS
    parts = np.std(error[: _PARTS * length].reshape(_PARTS, length), axis=1)
    return Played(
        begin_s, end_s, float(np.mean(error)), float(np.std(error)), float(np.min(parts)), float(np.max(parts))
    )


def _reason(
    fit: RecordedFit, known: Disturbance, moved: Floats, error: Floats, step_s: float, missing_rad2: float
) -> str:
    """Why the fitted residual differs from the played one, by the first of the known reasons that holds.

    The loop's gain by frequency is read off the two motions, so that it holds whatever the loop.
    """
    if fit.stationarity.reason:
        return f"the recording is not stationary: {fit.stationarity.reason}"
    half = min(fit.motion.half_rate_hz, 0.5 / step_s)
    outside = float(band_rms(replace(known, lines=()), np.array([half, math.inf]))[0])
    if outside**2 > 0.5 * missing_rad2 > 0.0:
        return (
            f"the fit has {format_quantity(outside, 'rad', 3)} above {format_quantity(half, 'Hz', 3)}, where the "
            "recording has ended"
        )
    freq, motion, _ = density(moved - np.mean(moved), step_s)
    _, left, _ = density(error - np.mean(error), step_s)
    used = slice(2, int(np.searchsorted(freq, 0.9 * half)))
    freq, motion, left = freq[used], motion[used], left[used]
    model, width = psd(known, freq), float(freq[1] - freq[0])
    for line in known.lines:  # a Hann window spreads a line over four bins
        at = int(np.argmin(np.abs(freq - line.freq_hz)))
        near = slice(max(at - 2, 0), at + 3)
        model[near] += 0.5 * line.amplitude_rad**2 / width / model[near].size
    band = np.floor(_BANDS_PER_OCTAVE * np.log2(freq / freq[0]))
    starts = np.flatnonzero(np.diff(band, prepend=-1.0))
    gain = left / motion
    had, has = (np.add.reduceat(gain * each, starts) * width for each in (motion, model))
    worst = int(np.argmax(np.abs(had - has)))
    inside = slice(starts[worst], freq.size if worst + 1 == starts.size else starts[worst + 1])
    at = freq[inside][np.argmax(np.abs(gain * (motion - model))[inside])]
    return (
        f"near {at:.4g} Hz the loop leaves {format_quantity(math.sqrt(had[worst]), 'rad', 3)} of the "
        f"recording and {format_quantity(math.sqrt(has[worst]), 'rad', 3)} of the fit: a line or a resonance that the "
        "fit misses"
    )
