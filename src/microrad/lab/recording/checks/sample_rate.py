"""The sample rate: given, stated by the file, or told by a time column, which is checked for gaps and jitter."""

import math
from collections.abc import Callable, Sequence

import numpy as np

from microrad.core.arrays import Floats
from microrad.core.units import LEAST, MOST, plain
from microrad.lab.recording.formats.source import StatedRate
from microrad.lab.recording.records import Finding, RecordingError

# Two statements of one rate differ by rounding, by clock tolerance (below 100 ppm), or they are two rates.
_SAME_RATE = 1e-3
# A step that is half as long again as the usual one has lost time that no clock wanders by.
_GAP = 1.5
# A constant step that is no multiple of the last digit is rounded to two steps, the rarer one at even distances: one
# that is rarer than this, and not so, is no rounding.
_RARE = 0.01
# The output changes by 2π f δt for a jitter δt at the frequency f: with ten samples per period 1 % of a step is 0.6 %
# of the amplitude, about what a good sensor's noise is; 10 % is 6 %, as large as a hysteresis loop.
_JITTER_NOTE, _JITTER_REFUSED = 0.01, 0.10


def check_rate(where: str, rate_hz: object) -> float:
    """The rate as a positive finite float.

    Args:
        where: The file in the words of a message.
        rate_hz: What is given as the samples per second.

    Raises:
        RecordingError: For what is no positive finite number.
    """
    is_number = isinstance(rate_hz, int | float | np.integer | np.floating) and not isinstance(rate_hz, bool)
    if not is_number or not LEAST <= rate_hz <= MOST:  # type: ignore[operator]
        raise RecordingError(
            f"{where}: the sample rate is {rate_hz!r}; give the samples per second as a positive number in Hz."
        )
    return float(rate_hz)  # type: ignore[arg-type]


def agreed_rate(where: str, rate_hz: float | None, stated: Sequence[StatedRate]) -> float:
    """The rate given, else the one that the file states, in Hz.

    Args:
        where: The file in the words of a message.
        rate_hz: The rate given, in Hz, None where none is.
        stated: The rates that the file states.

    Raises:
        RecordingError: Where two rates differ, or none is known.
    """
    known = [StatedRate(rate_hz, "given")] if rate_hz is not None else []
    known += stated
    if not known:
        raise RecordingError(
            f"{where}: the file does not say how fast it was sampled; give the rate (--rate, rate_hz) in Hz, or name "
            "the time column (time)."
        )
    for each in known:
        check_rate(f"{where} ({each.words})" if each.words != "given" else where, each.rate_hz)
    first = known[0]
    for other in known[1:]:
        if abs(other.rate_hz - first.rate_hz) > _SAME_RATE * first.rate_hz:
            raise RecordingError(
                f"{where}: two sample rates: {first.rate_hz:.7g} Hz ({first.words}) and {other.rate_hz:.7g} Hz "
                f"({other.words}), {plain(other.rate_hz / first.rate_hz, 4)} times as much; correct the wrong one"
                f"{' (leave the rate out to use that of the file)' if rate_hz is not None else ''}."
            )
    return first.rate_hz


def rate_of_time(
    where: str, label: str, time_s: Floats, place: Callable[[int], str]
) -> tuple[StatedRate, list[Finding]]:
    """Sample rate that a time column tells, and findings on its steps.

    Args:
        where: The file in the words of a message.
        label: The time column in the words of a message.
        time_s: The times, in s, shape (samples,).
        place: Says where in the file a sample of that number stands, for a message.

    Raises:
        RecordingError: Where a time is no number, or time stops, jumps or runs back.
    """
    bad = ~np.isfinite(time_s)
    if bad.any():
        row = int(np.argmax(bad))
        raise RecordingError(f"{where}: {place(row)}, {label}: the time is {time_s[row]}; repair it or cut there.")
    span = float(time_s[-1] - time_s[0])
    steps = np.diff(time_s)
    row = int(np.argmin(steps))
    if not steps.any():
        raise RecordingError(
            f"{where}: {label}: the time of all {time_s.size} samples is {time_s[0]:.9g} s; write their true times, or "
            "take the column out of the file and give the sample rate."
        )
    if steps[row] < 0:
        raise RecordingError(
            f"{where}: {place(row + 1)}, {label}: time runs back from {time_s[row]:.9g} to {time_s[row + 1]:.9g} s; "
            "two recordings may have been joined: cut them apart."
        )
    findings = _steps(where, label, steps, span / steps.size, _resolution(time_s), place)
    return StatedRate(
        float(f"{1 / (span / steps.size):.9g}"), f"{label}: {time_s.size} samples in {span:.9g} s"
    ), findings


def _resolution(time_s: Floats) -> float:
    """Smallest step that the digits, or the type before it became float64, can show."""
    stride = max(1, time_s.size // 2000)
    sample = np.concatenate([time_s[::stride], time_s[: 2 * stride]])  # far ones may all be round: neighbours are not
    largest = float(np.max(np.abs(time_s[[0, -1]])))
    rounding = 4 * float(np.spacing(largest))
    if np.array_equal(sample.astype(np.float32).astype(np.float64), sample):
        rounding = max(rounding, float(np.spacing(np.float32(largest))))
    for digits in range(13):
        scaled = sample * 10.0**digits
        if np.max(np.abs(scaled - np.round(scaled))) <= max(1e-6, 8 * np.spacing(largest * 10.0**digits)):
            return max(rounding, 10.0**-digits)
    return rounding


def _slack(steps: Floats, step_s: float, resolution_s: float) -> float:
    """How far rounding of the digits alone can move a step: nothing where the step is a multiple of the last digit.

    Where nearly all steps are the usual one and the others do not come at even distances, as those of a clock that is a
    little slow do, that is the step: the mean of all has lost samples in it.

    A grid with a constant step strays from its own straight line by one unit of the last digit at most; what strays
    farther is no rounding.
    """
    usual = float(np.median(steps))
    others = np.flatnonzero(np.abs(steps - usual) > 0.5 * resolution_s)
    even = others.size > 2 and np.ptp(np.diff(others)) <= 2
    step = usual if others.size < _RARE * steps.size and not even else step_s
    parts = step / resolution_s if resolution_s else math.inf
    if parts > 100 or (parts > 0.5 and abs(parts - round(parts)) < 1e-6):
        return 0.0
    astray = np.cumsum(steps - step_s)
    return resolution_s if float(np.ptp(astray)) <= 2.02 * resolution_s else 0.0


def _steps(
    where: str, label: str, steps: Floats, step_s: float, resolution_s: float, place: Callable[[int], str]
) -> list[Finding]:
    """Findings of the steps of a time column: `step_s` is their mean, `resolution_s` what its digits can show."""
    usual = float(np.median(steps)) or step_s
    slack = _slack(steps, step_s, resolution_s)
    gaps = np.flatnonzero(steps > _GAP * usual + slack)
    stops = np.flatnonzero(steps < (2 - _GAP) * usual - slack) if slack < usual else np.empty(0, int)
    if gaps.size and not (stops.size and stops[0] < gaps[0]):
        row = int(gaps[0])
        lost = int(np.sum(np.round(steps[gaps] / usual) - 1))
        raise RecordingError(
            f"{where}: {place(row + 1)}, {label}: {steps[row]:.6g} s since the sample before, where {usual:.6g} s is "
            f"usual; {gaps.size} gap{'s' if gaps.size > 1 else ''}, about {lost} sample{'s' * (lost != 1)} lost. Cut "
            "the recording there, because hysteresis remembers what happened in the gap."
        )
    if stops.size:
        row = int(stops[0])
        raise RecordingError(
            f"{where}: {place(row + 1)}, {label}: {steps[row]:.6g} s since the sample before, where {usual:.6g} s is "
            f"usual, {'once' if stops.size == 1 else f'{stops.size} times'} in all; samples were written twice or "
            "late: remove them or record again."
        )
    deviation = steps - step_s
    square = float(deviation @ deviation) / steps.size - slack**2 / 6
    jitter = math.sqrt(max(square, 0.0)) / step_s
    if slack >= usual:
        text = (
            f"{label} is printed to {resolution_s:.3g} s, coarser than the step of {step_s:.3g} s; gaps "
            "shorter than that would not show"
        )
        return [Finding("jitter", label, None, text, False)]
    if jitter <= _JITTER_NOTE:
        return []
    row = int(np.argmax(np.abs(deviation)))
    text = (
        f"{label}: the steps scatter by {plain(100 * jitter, 2)} % rms of {step_s:.6g} s, most at {place(row + 1)} "
        f"({steps[row]:.6g} s); record with a hardware clock, or resample to a constant step"
    )
    return [Finding("jitter", label, row + 1, text, jitter > _JITTER_REFUSED)]
