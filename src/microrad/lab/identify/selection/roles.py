"""What a recording can serve for, judged by its drive: broadband for the linear part, or loops for the hysteresis."""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from microrad.lab.recording import Recording


class Roles(NamedTuple):
    """Recordings by what they serve for; ``response`` is the part of ``broadband`` that can be averaged together."""

    response: list[Recording]
    broadband: list[Recording]
    loops: list[Recording]


def roles(recordings: Sequence[Recording]) -> Roles:
    """Sort recordings: small broadband ones for the linear part, all others as loops.

    Small is a drive of at most half the largest peak-to-peak, where there are loops at all: a large multisine shows
    hysteresis. Of the broadband ones those at the highest sample rate are averaged, periodic ones before chirps.
    """
    largest = max(float(np.ptp(r.drive)) for r in recordings)
    wide = [r for r in recordings if is_broadband(r)]
    broadband = [r for r in wide if float(np.ptp(r.drive)) <= 0.5 * largest] if len(wide) < len(recordings) else wide
    chosen = {id(r) for r in broadband}
    loops = [r for r in recordings if id(r) not in chosen] or list(recordings)
    best = max(((r.rate_hz, r.period_samples or 0) for r in broadband), default=(0.0, 0))
    response = [r for r in broadband if (r.rate_hz, r.period_samples or 0) == best]
    return Roles(response, broadband, loops)


def whole_periods(head: Recording) -> Recording:
    """The first part of a periodic recording cut to whole periods; with fewer than two of them it has no period."""
    period = head.period_samples
    if period is None or head.samples < 2 * period:
        return replace(head, period_samples=None)
    return head.first(head.samples // period * period)


def is_broadband(recording: Recording) -> bool:
    """Whether the drive fills a decade of frequencies or more without a gap, as a chirp or a multisine does.

    Power times frequency (so that a logarithmic chirp is flat) is summed over tenths of decades; those above a
    thousandth of the largest count, and eleven of them in a row are more than a decade. A sine fills two or three, and
    a triangle has gaps between its harmonics. A staircase has none, but rests on a few levels most of the time.
    """
    drive = recording.drive[:, 0] - recording.drive[:, 0].mean()
    levels = np.sort(np.histogram(drive, bins=1000)[0])
    if levels[-20:].sum() > 0.5 * drive.size:
        return False
    spectrum = np.abs(np.fft.rfft(drive * np.hanning(drive.size))) ** 2
    frequency = np.arange(1, spectrum.size)
    band = np.floor(10 * np.log10(frequency)).astype(int)
    power = np.bincount(band, weights=spectrum[1:])
    filled = power > 1e-3 * power.max()
    longest = run = 0
    for one in filled:
        run = run + 1 if one else 0
        longest = max(longest, run)
    return longest > 10
