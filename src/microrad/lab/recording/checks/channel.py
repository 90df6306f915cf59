"""What one channel's values say about themselves: quantisation, drift and clipping.

Clipping shows as flat tops that a moving mirror cannot make, and as pile-up at the extremes of fast signals.
"""

import math
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from microrad.core.arrays import Floats, Integers
from microrad.lab.recording.records import Finding

_SUBSAMPLE = 20_000
# The narrowest loops of piezo mirrors are about 2 % of peak-to-peak wide. With fewer than 50 levels such a loop is
# thinner than one level: nothing of it is left. From 500 levels on it spans ten.
_LEVELS_REFUSED, _LEVELS_NOTE = 50, 500
# A smooth drive visits ten places for each level of the output; one that steps visits about one.
_SMOOTH = 5
_DRIFT_NOTE, _DRIFT_REFUSED = 0.005, 0.5
_BLOCKS = 8
# Half a loop of hysteresis looks like a drift: two full cycles of the drive tell them apart.
_CROSSINGS = 4


def subsample(values: Floats) -> Floats:
    """Runs of neighbours from all over the record."""
    if values.size <= _SUBSAMPLE:
        return values
    runs, length = 20, _SUBSAMPLE // 20
    starts = np.linspace(0, values.size - length, runs).astype(int)
    return np.concatenate([values[s : s + length] for s in starts])


def quantum(values: Floats) -> float:
    """The quantisation step: the smallest distance of two values of which all others are multiples, else 0."""
    unique = np.unique(subsample(values))
    if unique.size < 2:
        return 0.0
    gaps = np.diff(unique)
    span = float(unique[-1] - unique[0])
    rounding = 16 * float(np.spacing(np.max(np.abs(unique))))
    gaps = gaps[gaps > rounding]
    if gaps.size == 0:
        return 0.0
    step = float(gaps.min())
    step = float(np.median(gaps[gaps < 1.5 * step]))
    multiples = gaps[gaps < 100 * step] / step
    if span / step > 1e7 or np.max(np.abs(multiples - np.round(multiples))) > 0.1 + 100 * rounding / step:
        return 0.0
    return step


def quantisation(label: str, values: Floats, drives: Sequence[Floats] | None) -> list[Finding]:
    """Findings on the levels that a channel resolves, of an output where its drive has more of them.

    Noise of half a step or more between neighbours dithers: averaging then recovers what lies between two levels, and
    the finding is only noted. The levels of an input are noted.

    Args:
        label: The channel in the words of a message.
        values: Its samples, shape (samples,), finite.
        drives: The inputs, each (samples,), where the channel is an output; None where it is an input itself.
    """
    step = quantum(values)
    span = float(np.ptp(values))
    if step == 0 or span / step >= _LEVELS_NOTE:
        return []
    levels = np.unique(subsample(values)).size
    coarse = f"{label} moves in steps of {step:.4g}, {_percent(step / span)} of its peak-to-peak ({levels} levels"
    if drives is None:
        return [Finding("quantisation", label, None, f"{coarse}); a finer converter would drive more evenly", False)]
    shown = max(_places(drive, step / span) for drive in drives)
    if shown < _SMOOTH * levels:  # the drive itself holds a few levels
        return []
    dithered = _flicker(values, step) > 0.25
    refused = span / step < _LEVELS_REFUSED and not dithered
    text = (
        f"{coarse}{', dithered by noise' if dithered else ''}); a hysteresis loop of 2 % would be "
        f"{0.02 * span / step:.2g} steps wide: use a smaller range of the converter or a larger motion"
    )
    return [Finding("quantisation", label, None, text, refused)]


def _percent(share: float) -> str:
    """Two digits of a share, and no power of ten where it is all."""
    return f"{100 * share:.{2 if share < 0.995 else 3}g} %"


def _places(drive: Floats, share: float) -> int:
    """How many places the drive visits, when told apart ten times as finely as the output's steps."""
    return int(np.unique(np.floor(subsample(drive) / (0.1 * share * np.ptp(drive)))).size)


def _flicker(values: Floats, step: float) -> float:
    """Share of the samples that reverse the direction of the change before: that is noise, not motion."""
    changes = np.sign(np.diff(subsample(values)))
    return float(np.count_nonzero(changes[1:] * changes[:-1] < 0)) / max(changes.size, 1)


def drift(label: str, values: Floats, drives: Sequence[Floats]) -> list[Finding]:
    """Findings on the linear trend of an output that the drives do not explain, as a share of its peak-to-peak.

    Regression of the output on drives, time and a constant; the standard error of the trend follows from the scatter of
    eight block means, so that slow noise is not taken for drift. Noted from 0.5 % on. Above half of peak-to-peak the
    drift is the larger part of what was recorded, unless drives seen through slow low-passes explain it: then the
    mirror is still answering a step.

    Args:
        label: The output in the words of a message.
        values: Its samples, shape (samples,), finite.
        drives: The inputs, each of shape (samples,).
    """
    # Block means instead of every n-th sample: they do not alias.
    y, *u = (block_means(column, max(1, values.size // 50_000)) for column in (values, *drives))
    trend, error = _trend(y, u)
    share = abs(trend) / float(np.ptp(values))
    if share < _DRIFT_NOTE or abs(trend) < 5.0 * error:
        return []
    refused = share > _DRIFT_REFUSED and abs(_trend(y, [*u, *_slow(u)])[0]) / float(np.ptp(values)) > _DRIFT_REFUSED
    if not refused and max(_crossings(c) for c in u) < _CROSSINGS:
        return []
    text = (
        f"{label} drifts by {trend:.4g} ± {error:.2g} over the record, {_percent(share)} of its peak-to-peak, where "
        "the drive does not: creep or a warming sensor; let it settle before recording, or record shorter"
    )
    return [Finding("drift", label, None, text, refused)]


def _crossings(drive: Floats) -> int:
    """How often the drive crosses the middle of its range."""
    above = drive > 0.5 * (drive.max() + drive.min())
    return int(np.count_nonzero(above[1:] != above[:-1]))


def _trend(y: Floats, drives: Sequence[Floats]) -> tuple[float, float]:
    """Change of `y` over the record that is linear in time and not in the drives, and its standard error."""
    time = np.linspace(-0.5, 0.5, y.size)
    table = np.column_stack([*(c - c.mean() for c in drives), np.ones(y.size)])
    scale = np.sqrt(np.mean(table**2, axis=0))
    table = table[:, scale > 0] / scale[scale > 0]
    own = time - table @ np.linalg.lstsq(table, time, rcond=None)[0]
    if own @ own < 0.1 * (time @ time):  # the drives have the trend themselves
        return 0.0, 0.0
    residual = y - table @ np.linalg.lstsq(table, y, rcond=None)[0]
    trend = float(own @ residual / (own @ own))
    residual = residual - trend * own
    window = np.hanning(y.size // _BLOCKS + 2)[1:-1]  # lets no loop of the drive leak into the means
    blocks = residual[: y.size // _BLOCKS * _BLOCKS].reshape(_BLOCKS, -1) @ window / window.sum()
    # The slope over unit time from m block means has the variance 12 s² / m.
    return trend, math.sqrt(12 * float(np.var(blocks)) / (_BLOCKS - 2))


def _slow(drives: Sequence[Floats]) -> list[Floats]:
    """The drives behind first-order low-passes with time constants of 1, 3 and 10 % of the record."""
    from scipy.signal import lfilter

    poles = [(drive, math.exp(-1 / (share * drive.size))) for drive in drives for share in (0.01, 0.03, 0.1)]
    return [lfilter([1 - pole], [1, -pole], drive - drive[0]) for drive, pole in poles]


def block_means(values: Floats, length: int) -> Floats:
    """Means of blocks of samples; a last block that is not full is left out.

    Args:
        values: The samples, shape (samples,).
        length: Samples in each block.
    """
    if length == 1:
        return values
    return np.asarray(values[: values.size // length * length].reshape(-1, length).mean(axis=1))


_MIN_RUN = 3
# A rounded peak of a quantised signal rests on its top code while it rises by one step; seen from its flanks it would
# have gone two steps higher (parabola). Six steps cannot be rounding.
_QUANTA = 6.0
# What is cut off must matter: 0.4 % of peak-to-peak is below the residual of any hysteresis model known here.
_SHARE = 4e-3
# A rounded peak is left about as steeply as it is entered; a step response that has settled is left 100 times steeper.
_ASYMMETRY = 4.0
# A drive that ramps to its limit and rests there enters at a constant slope; a clipped sine already slows down.
_SLOWING = 0.97


def clipping(label: str, values: Floats, place: Callable[[int], str], drives: Sequence[Floats] | None) -> list[Finding]:
    """Findings on one channel that is cut off at its highest or lowest value.

    A flat top counts when its flanks are smooth and steep enough to hide more than rounding, on at least two peaks.
    At the top of an output the drive must go on moving (a resting mirror is no fault); a drive must have curved
    flanks (a ramp that rests at its limit is meant).

    Args:
        label: The channel in the words of a message.
        values: Its samples, shape (samples,), finite.
        place: Says where in the file a sample of that number stands, for a message.
        drives: The inputs, each (samples,), where the channel is an output; None where it is an input itself.
    """
    found = []
    low, high = float(values.min()), float(values.max())
    # Exact equality is meant: a converter at its end returns one code.
    extremes = ((high, np.flatnonzero(values == high), 1.0), (low, np.flatnonzero(values == low), -1.0))
    if max(at.size for _, at, _ in extremes) < 2 * _MIN_RUN:
        return []
    step = quantum(values)
    remedy = (
        "lower the drive, or widen the range of the converter that recorded it"
        if drives is None
        else "widen the sensor's or the converter's range, or lower the drive"
    )
    # Where the drive rests at its limits, an output may do so for about as long.
    resting = max((_resting(drive) for drive in drives), default=0) if drives else 0
    for limit, at, sign in extremes:
        if at.size <= 1.5 * resting:
            continue
        rows, hidden = _flat_tops(values, at, sign, step, high - low, drives)
        if rows.size >= 2:
            share = 100 * float(np.median(hidden)) / (high - low)
            text = (
                f"{label} is clipped at {limit:.6g}: {rows.size} flat tops, the first at {place(int(rows[0]))}, "
                f"{at.size} samples at exactly that value, about {share:.2g} % of peak-to-peak cut off; {remedy}"
            )
            found.append(Finding("clipping", label, int(rows[0]), text, True))
        elif drives is not None and _piles_up(values, at, limit, step, high - low):
            text = (
                f"{label} is clipped at {limit:.6g}: {at.size} samples are exactly there and hardly any just beside "
                f"it, the first at {place(int(at[0]))}; {remedy}"
            )
            found.append(Finding("clipping", label, int(at[0]), text, True))
    return found


def _flat_tops(
    values: Floats,
    at: Integers,
    sign: float,
    step: float,
    span: float,
    drives: Sequence[Floats] | None,
) -> tuple[Integers, Floats]:
    """First rows of the flat tops, and how much each of them hides."""
    breaks = np.flatnonzero(np.diff(at) > 1)
    starts = at[np.concatenate(([0], breaks + 1))] if at.size else at
    lengths = np.diff(np.concatenate(([-1], breaks, [at.size - 1]))) if at.size else at
    near = np.clip(lengths // 2, 4, 8)
    inside = (lengths >= _MIN_RUN) & (starts > 2 * near) & (starts + lengths + 2 * near < values.size)
    starts, lengths, near = starts[inside], lengths[inside], near[inside]
    ends = starts + lengths - 1
    entry = sign * (values[starts - 1] - values[starts - 1 - near]) / near
    leave = sign * (values[ends + 1] - values[ends + 1 + near]) / near
    jump = sign * (values[starts] - values[starts - 1])
    drop = sign * (values[ends] - values[ends + 1])
    gentle, steep = np.minimum(entry, leave), np.maximum(entry, leave)
    hidden = gentle * lengths / 4  # parabola through both flanks
    flat = (gentle > 0) & (steep <= _ASYMMETRY * gentle)
    flat &= (jump <= 3 * entry) & (drop <= 3 * leave)  # a step or a switched level jumps
    flat &= hidden > max(_QUANTA * step, _SHARE * span)
    if drives is None:
        flat &= _curved(values, starts, ends, np.maximum(near, lengths // 2), sign, entry, leave)
    elif flat.any():
        flat[flat] = _moves(drives, starts[flat], ends[flat], hidden[flat] / span)
    return starts[flat], hidden[flat]


def _curved(
    values: Floats,
    starts: Integers,
    ends: Integers,
    width: Integers,
    sign: float,
    entry: Floats,
    leave: Floats,
) -> NDArray[np.bool_]:
    """Whether both flanks are steeper farther away, as those of a rounded peak are."""
    before, after = starts - 1 - width, ends + 1 + width
    inside = (before - width >= 0) & (after + width < values.size)
    before, after = np.where(inside, before, width), np.where(inside, after, 0)
    farther = sign * (values[before] - values[before - width]) / width
    later = sign * (values[after] - values[np.minimum(after + width, values.size - 1)]) / width
    curved: NDArray[np.bool_] = inside & (entry < _SLOWING * farther) & (leave < _SLOWING * later)
    return curved


def _moves(drives: Sequence[Floats], starts: Integers, ends: Integers, hidden: Floats) -> NDArray[np.bool_]:
    """Whether a drive moves in the inner half of the flat top, by a tenth at least of what the output hides.

    The outer quarters do not count: there a delayed output rests while the drive is already on its way.
    """
    moving = np.zeros(starts.size, dtype=bool)
    quarter = (ends - starts) // 4
    middle = (starts + ends) // 2
    for drive in drives:
        span = float(np.ptp(drive))
        first, last = drive[starts + quarter], drive[ends - quarter]
        largest = np.maximum(np.abs(drive[middle] - first), np.abs(last - drive[middle]))
        moving |= largest > 0.1 * hidden * span
    return moving


def _resting(drive: Floats) -> int:
    """Samples that a drive spends at one of its extremes, if it stays there for two at least."""
    ends = (drive == drive.max(), drive == drive.min())
    return max((int(np.count_nonzero(at)) for at in ends if np.any(at[1:] & at[:-1])), default=0)


def _piles_up(values: Floats, at: Integers, limit: float, step: float, span: float) -> bool:
    """Whether single samples gather at the limit of a signal too fast to show flat tops.

    Below the limit a band of 1 % of peak-to-peak is counted: a signal that turns there spends longer in the band than
    at its top, a clipped one has its whole tail at the top. Signals that repeat other values as often (squares, steps,
    periods of a whole number of samples) are out.
    """
    if not max(10, 1e-3 * values.size) <= at.size <= 0.3 * values.size or step > 0.01 * span:
        return False
    breaks = np.count_nonzero(np.diff(at) > 1) + 1
    if at.size / breaks >= _MIN_RUN:
        return False
    levels, counts = np.unique(subsample(values), return_counts=True)
    inner = counts[(levels > values.min()) & (levels < values.max())]
    there = int(counts[levels == limit].sum())
    if inner.size == 0 or there < 5 * inner.max():
        return False
    beside = int(np.count_nonzero(np.abs(values - limit) <= 0.01 * span)) - at.size
    return at.size > 5 * max(beside, 2)
