"""Where a recording is split into the part that is fitted and the one that is held out to judge by."""

from collections.abc import Sequence

import numpy as np

from microrad.core.arrays import Floats
from microrad.lab.identify.records import IdentificationError
from microrad.lab.recording import Recording

_MIN_PART = 100
_COVERED, _SWEPT = 0.9, 0.99  # of a record's range: what the fitted part needs, and where it is ended otherwise
_LEAST = 0.05  # of a record is held out


def split_points(recordings: Sequence[Recording], hold_out: float | None, *, validated: bool) -> list[int]:
    """First sample of each recording that no fit sees.

    Where no share is given that is the middle, or later, so that the drive has swept its range in the fitted part.

    Args:
        recordings: Those that are to be fitted.
        hold_out: Share at the end of each that is held out; None for half, and for nothing with validation.
        validated: Whether there are recordings for validation.

    Raises:
        IdentificationError: If the share cannot be used, or leaves too little of a recording.
    """
    share = (0.0 if validated else 0.5) if hold_out is None else hold_out
    if not (0 < share < 1 or (share == 0 and validated)):
        raise IdentificationError(
            f"--hold-out (hold_out) is {share}; give the share of each recording kept for the check, between 0 "
            "and 1, e.g. 0.5, or 0 with recordings for validation."
        )
    found = [round(r.samples * (1 - share)) for r in recordings]
    if hold_out is None:
        found = [_behind_its_range(r.drive[:, 0], split) for r, split in zip(recordings, found, strict=True)]
    for recording, split in zip(recordings, found, strict=True):
        if split < _MIN_PART or (share > 0 and recording.samples - split < _MIN_PART):
            raise IdentificationError(
                f"{recording.path}: {split} samples to fit and {recording.samples - split} to check; each part needs "
                f"at least {_MIN_PART}; record longer or choose hold_out nearer to 0.5."
            )
    return found


def _behind_its_range(drive: Floats, split: int) -> int:
    """The split, or where the drive has swept its range if that comes later and leaves enough to judge by."""
    swept = np.maximum.accumulate(drive) - np.minimum.accumulate(drive)
    if swept[split - 1] >= _COVERED * swept[-1]:
        return split
    later = int(np.argmax(swept >= _SWEPT * swept[-1])) + 1
    return later if drive.size - later >= max(_MIN_PART, _LEAST * drive.size) else split


def split_warnings(recordings: Sequence[Recording], found: Sequence[int], volts: float) -> list[str]:
    """Recordings that are split later than in the middle, or whose fitted part sweeps only a part of their range.

    Args:
        recordings: Those that are fitted.
        found: First sample of each that no fit sees.
        volts: Volts in one unit of their drives.
    """
    told = []
    for recording, split in zip(recordings, found, strict=True):
        drive = volts * recording.drive[:, 0]
        (low, high), (lowest, highest) = ((float(d.min()), float(d.max())) for d in (drive[:split], drive))
        if high - low < _COVERED * (highest - lowest):
            told.append(
                f"{recording.path}: the fitted part sweeps {low:.3g} V to {high:.3g} V of the {lowest:.3g} V to "
                f"{highest:.3g} V that were recorded; hold less out, record more periods, or give another recording "
                "for validation."
            )
        elif drive.size > split > drive.size // 2 + 1 and _behind_its_range(drive, drive.size // 2) == split:
            told.append(
                f"{recording.path}: the last {100 * (1 - split / drive.size):.0f} % are held out instead of half, "
                "because only then has the drive swept its range in the fitted part."
            )
    return told
