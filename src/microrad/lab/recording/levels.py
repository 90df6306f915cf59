"""What one channel's values say about themselves: the quantisation step and the drift."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from microrad.lab.recording.records import Finding, FloatArray

_SUBSAMPLE = 20_000
# The narrowest loops of piezo mirrors are about 2 % of peak-to-peak wide. With fewer than 50 levels such a loop is
# thinner than one level: nothing of it is left. From 500 levels on it spans ten.
_LEVELS_REFUSED, _LEVELS_NOTE = 50, 500
# A smooth drive visits ten places for each level of the output; one that steps visits about one.
_SMOOTH = 5
_DRIFT_NOTE, _DRIFT_REFUSED = 0.005, 0.5
_DRIFT_SIGNIFICANT = 5.0
_BLOCKS = 8
# Half a loop of hysteresis looks like a drift: two full cycles of the drive tell them apart.
_CROSSINGS = 4


def subsample(values: FloatArray) -> FloatArray:
    """Runs of neighbours from all over the record."""
    if values.size <= _SUBSAMPLE:
        return values
    runs, length = 20, _SUBSAMPLE // 20
    starts = np.linspace(0, values.size - length, runs).astype(int)
    return np.concatenate([values[s : s + length] for s in starts])


def quantum(values: FloatArray) -> float:
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


def quantisation(label: str, values: FloatArray, drives: Sequence[FloatArray] | None) -> list[Finding]:
    """Levels that an output resolves, where the drive itself has more of them than the output.

    Noise of half a step or more between neighbours dithers: averaging then recovers what lies between two levels, and
    the finding is only noted. The levels of an input are noted.
    """
    step = quantum(values)
    span = float(np.ptp(values))
    if step == 0 or span / step >= _LEVELS_NOTE:
        return []
    levels = np.unique(subsample(values)).size
    coarse = f"{label} moves in steps of {step:.4g}, {100 * step / span:.2g} % of its peak-to-peak ({levels} levels"
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


def _places(drive: FloatArray, share: float) -> int:
    """How many places the drive visits, when told apart ten times as finely as the output's steps."""
    return int(np.unique(np.floor(subsample(drive) / (0.1 * share * np.ptp(drive)))).size)


def _flicker(values: FloatArray, step: float) -> float:
    """Share of the samples that reverse the direction of the change before: that is noise, not motion."""
    changes = np.sign(np.diff(subsample(values)))
    return float(np.count_nonzero(changes[1:] * changes[:-1] < 0)) / max(changes.size, 1)


def drift(label: str, values: FloatArray, drives: Sequence[FloatArray]) -> list[Finding]:
    """The linear trend that the drives do not explain, as a share of peak-to-peak.

    Regression of the output on drives, time and a constant; the standard error of the trend follows from the scatter of
    eight block means, so that slow noise is not taken for drift. Noted from 0.5 % on. Above half of peak-to-peak the
    drift is the larger part of what was recorded, unless drives seen through slow low-passes explain it: then the
    mirror is still answering a step.
    """
    stride = max(1, values.size // 50_000)
    # Block means instead of every n-th sample: they do not alias.
    y, *u = (_block_means(column, stride) for column in (values, *drives))
    trend, error = _trend(y, u)
    share = abs(trend) / float(np.ptp(values))
    if share < _DRIFT_NOTE or abs(trend) < _DRIFT_SIGNIFICANT * error:
        return []
    refused = share > _DRIFT_REFUSED and abs(_trend(y, [*u, *_slow(u)])[0]) / float(np.ptp(values)) > _DRIFT_REFUSED
    if not refused and max(_crossings(c) for c in u) < _CROSSINGS:
        return []
    text = (
        f"{label} drifts by {trend:.4g} ± {error:.2g} over the record, {100 * share:.2g} % of its peak-to-peak, where "
        "the drive does not: creep or a warming sensor; let it settle before recording, or record shorter"
    )
    return [Finding("drift", label, None, text, refused)]


def _crossings(drive: FloatArray) -> int:
    """How often the drive crosses the middle of its range."""
    above = drive > 0.5 * (drive.max() + drive.min())
    return int(np.count_nonzero(above[1:] != above[:-1]))


def _trend(y: FloatArray, drives: Sequence[FloatArray]) -> tuple[float, float]:
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


def _slow(drives: Sequence[FloatArray]) -> list[FloatArray]:
    """The drives behind first-order low-passes with time constants of 1, 3 and 10 % of the record."""
    from scipy.signal import lfilter

    slow = []
    for drive in drives:
        for share in (0.01, 0.03, 0.1):
            pole = math.exp(-1 / (share * drive.size))
            slow.append(lfilter([1 - pole], [1, -pole], drive - drive[0]))
    return slow


def _block_means(values: FloatArray, length: int) -> FloatArray:
    if length == 1:
        return values
    means: FloatArray = values[: values.size // length * length].reshape(-1, length).mean(axis=1)
    return means
