"""What a recording serves for, as it says or as its drive tells: the linear part, the hysteresis, or validation."""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from microrad.lab.identify.records import IdentificationError
from microrad.lab.recording import Recording

_SINE = 4  # tenths of a decade that a sine fills at most, its amplitude growing or not


class Roles(NamedTuple):
    """Recordings by what they serve for; ``response`` is the part of ``broadband`` that can be averaged together."""

    response: list[Recording]
    broadband: list[Recording]
    loops: list[Recording]


def roles(recordings: Sequence[Recording]) -> Roles:
    """Sort recordings: small broadband ones for the linear part, all others as loops.

    What a recording says of its `role` counts. Else small is a drive of at most half the largest peak-to-peak, where
    there are loops at all: a large multisine shows hysteresis. Of the broadband ones those at the highest sample rate
    are averaged, periodic ones before chirps.

    Args:
        recordings: Those that are to be fitted.

    Raises:
        IdentificationError: If the drive of a recording cannot serve for its role, or all of them are to be broadband.
    """
    for r in recordings:
        if r.role == "broadband" and np.count_nonzero(_filled(r)) <= _SINE:
            raise IdentificationError(
                f"{r.path}: its role is broadband and its drive is a sine, of which a linear part cannot be told; give "
                "it the role loops, or leave the role out."
            )
    if all(r.role == "broadband" for r in recordings):
        raise IdentificationError(
            f"{recordings[0].path}: every recording has the role broadband, and none is left for the hysteresis; leave "
            "the role of one with a large drive out."
        )
    largest = max(float(np.ptp(r.drive)) for r in recordings)
    wide = [r for r in recordings if r.role == "broadband" or (not r.role and is_broadband(r))]
    broadband = wide
    if len(wide) < len(recordings):
        broadband = [r for r in wide if r.role == "broadband" or float(np.ptp(r.drive)) <= 0.5 * largest]
    chosen = {id(r) for r in broadband}
    loops = [r for r in recordings if id(r) not in chosen] or [r for r in recordings if r.role != "broadband"]
    best = max(((r.rate_hz, r.period_samples or 0) for r in broadband), default=(0.0, 0))
    response = [r for r in broadband if (r.rate_hz, r.period_samples or 0) == best]
    return Roles(response, broadband, loops)


def for_validation(
    recordings: Sequence[Recording], validation: Sequence[Recording]
) -> tuple[list[Recording], tuple[Recording, ...]]:
    """Recordings to fit, and those for validation, among them each that has that role.

    Args:
        recordings: Those given to be fitted, one or more.
        validation: Those given for validation.

    Raises:
        IdentificationError: If a recording given for validation has another role, or none is left to be fitted.
    """
    for r in validation:
        if r.role not in ("", "validation"):
            raise IdentificationError(
                f"{r.path}: it is given for validation and its role is {r.role}; give it to be fitted, or leave the "
                "role out."
            )
    fitted = [r for r in recordings if r.role != "validation"]
    if not fitted:
        raise IdentificationError(
            f"{recordings[0].path}: every recording has the role validation; leave one without a role, to be fitted."
        )
    return fitted, (*validation, *(r for r in recordings if r.role == "validation"))


def single_period(response: Sequence[Recording]) -> bool:
    """Whether one recording with less than two periods is all there is: then nothing tells noise from distortion.

    Args:
        response: Recordings that are to be averaged together.
    """
    return len(response) == 1 and response[0].samples < 2 * (response[0].period_samples or 0)


def whole_periods(head: Recording) -> Recording:
    """The first part of a periodic recording cut to whole periods; with fewer than two of them it has no period."""
    period = head.period_samples
    if period is None or head.samples < 2 * period:
        return replace(head, period_samples=None)
    return head.first(head.samples // period * period)


def is_broadband(recording: Recording) -> bool:
    """Whether the drive fills a decade of frequencies or more without a gap, as a chirp or a multisine does.

    A sine fills two or three tenths of a decade, and a triangle has gaps between its harmonics. A staircase has none,
    but rests on a few levels most of the time.
    """
    drive = recording.drive[:, 0]
    levels = np.sort(np.histogram(drive, bins=1000)[0])
    if levels[-20:].sum() > 0.5 * drive.size:
        return False
    longest = run = 0
    for one in _filled(recording):
        run = run + 1 if one else 0
        longest = max(longest, run)
    return longest > 10


def _filled(recording: Recording) -> NDArray[np.bool_]:
    """Which tenths of decades the drive fills.

    Power times frequency (so that a logarithmic chirp is flat) is summed over each; those above a thousandth of the
    largest count, and eleven of them in a row are more than a decade.
    """
    drive = recording.drive[:, 0] - recording.drive[:, 0].mean()
    spectrum = np.abs(np.fft.rfft(drive * np.hanning(drive.size))) ** 2
    frequency = np.arange(1, spectrum.size)
    band = np.floor(10 * np.log10(frequency)).astype(int)
    power = np.bincount(band, weights=spectrum[1:])
    return np.asarray(power > 1e-3 * power.max())
