"""Clipping: flat tops that a moving mirror cannot make, and pile-up at the extremes of fast signals."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from microrad.lab.recording.levels import quantum, subsample
from microrad.lab.recording.records import Finding, FloatArray

BoolArray = NDArray[np.bool_]
IntArray = NDArray[np.int_]

_MIN_RUN = 3
_MIN_PEAKS = 2
# A rounded peak of a quantised signal rests on its top code while it rises by one step; seen from its flanks it would
# have gone two steps higher (parabola). Six steps cannot be rounding.
_QUANTA = 6.0
# What is cut off must matter: 0.4 % of peak-to-peak is below the residual of any hysteresis model known here.
_SHARE = 4e-3
# A rounded peak is left about as steeply as it is entered; a step response that has settled is left 100 times steeper.
_ASYMMETRY = 4.0
# A drive that ramps to its limit and rests there enters at a constant slope; a clipped sine already slows down.
_SLOWING = 0.97


def clipping(
    label: str, values: FloatArray, place: Callable[[int], str], drives: Sequence[FloatArray] | None
) -> list[Finding]:
    """Judge one channel; `drives` are the inputs where it is an output, None where it is an input itself.

    A flat top counts when its flanks are smooth and steep enough to hide more than rounding, on at least two peaks.
    At the top of an output the drive must go on moving (a resting mirror is no fault); a drive must have curved
    flanks (a ramp that rests at its limit is meant).
    """
    found = []
    low, high = float(values.min()), float(values.max())
    # Exact equality is meant: a converter at its end returns one code.
    extremes = ((high, np.flatnonzero(values == high), 1.0), (low, np.flatnonzero(values == low), -1.0))
    if max(at.size for _, at, _ in extremes) < 2 * _MIN_RUN:
        return []
    step = quantum(values)
    # Where the drive rests at its limits, an output may do so for about as long.
    resting = max((_resting(drive) for drive in drives), default=0) if drives else 0
    for limit, at, sign in extremes:
        if at.size <= 1.5 * resting:
            continue
        rows, hidden = _flat_tops(values, at, sign, step, high - low, drives)
        if rows.size >= _MIN_PEAKS:
            share = 100 * float(np.median(hidden)) / (high - low)
            text = (
                f"{label} is clipped at {limit:.6g}: {rows.size} flat tops, the first at {place(int(rows[0]))}, "
                f"{at.size} samples at exactly that value, about {share:.2g} % of peak-to-peak cut off; "
                f"{_remedy(drives)}"
            )
            found.append(Finding("clipping", label, int(rows[0]), text, True))
        elif drives is not None and _piles_up(values, at, limit, step, high - low):
            text = (
                f"{label} is clipped at {limit:.6g}: {at.size} samples are exactly there and hardly any just beside "
                f"it, the first at {place(int(at[0]))}; {_remedy(drives)}"
            )
            found.append(Finding("clipping", label, int(at[0]), text, True))
    return found


def _remedy(drives: Sequence[FloatArray] | None) -> str:
    if drives is None:
        return "lower the drive, or widen the range of the converter that recorded it"
    return "widen the sensor's or the converter's range, or lower the drive"


def _flat_tops(
    values: FloatArray,
    at: IntArray,
    sign: float,
    step: float,
    span: float,
    drives: Sequence[FloatArray] | None,
) -> tuple[IntArray, FloatArray]:
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
    values: FloatArray,
    starts: IntArray,
    ends: IntArray,
    width: IntArray,
    sign: float,
    entry: FloatArray,
    leave: FloatArray,
) -> BoolArray:
    """Whether both flanks are steeper farther away, as those of a rounded peak are."""
    before, after = starts - 1 - width, ends + 1 + width
    inside = (before - width >= 0) & (after + width < values.size)
    before, after = np.where(inside, before, width), np.where(inside, after, 0)
    farther = sign * (values[before] - values[before - width]) / width
    later = sign * (values[after] - values[np.minimum(after + width, values.size - 1)]) / width
    curved: BoolArray = inside & (entry < _SLOWING * farther) & (leave < _SLOWING * later)
    return curved


def _moves(drives: Sequence[FloatArray], starts: IntArray, ends: IntArray, hidden: FloatArray) -> BoolArray:
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


def _resting(drive: FloatArray) -> int:
    """Samples that a drive spends at one of its extremes, if it stays there for two at least."""
    ends = (drive == drive.max(), drive == drive.min())
    return max((int(np.count_nonzero(at)) for at in ends if np.any(at[1:] & at[:-1])), default=0)


def _piles_up(values: FloatArray, at: IntArray, limit: float, step: float, span: float) -> bool:
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
