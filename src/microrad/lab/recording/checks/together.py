"""What recordings of several channels say together: each drive moves in one of them, and by itself."""

from collections.abc import Sequence

import numpy as np

from microrad.core.units import counted
from microrad.lab.recording.checks.drive_and_output import FAINT
from microrad.lab.recording.checks.signals import check_separable, covariance
from microrad.lab.recording.records import Recording, RecordingError


def check_together(recordings: Sequence[Recording], validation: Sequence[Recording] = ()) -> None:
    """Check what one recording cannot tell, as its drives may be played one after the other.

    Args:
        recordings: The recordings of a mirror, at least one, with the same inputs and outputs in the same order.
        validation: Recordings of the same channels that are not fitted.

    Raises:
        RecordingError: If they have other numbers of channels, if two hold the same data, if an input moves in none of
            `recordings` or is a combination of others in all of them, or if an output follows in none.
    """
    first = recordings[0]
    seen: dict[str, str] = {}
    for each in (*recordings, *validation):
        _check_alike(first, each)
        if each.sha256 in seen:
            raise RecordingError(
                f"{each.path}: the same data as {seen[each.sha256]}; give each recording once, and for validation one "
                "that is not fitted."
            )
        seen[each.sha256] = each.path
    where = first.path if len(recordings) == 1 else f"{first.path} and {len(recordings) - 1} more"
    total = np.sum([covariance(list(r.drive.T)) for r in recordings], axis=0)
    power = np.diag(total)
    labels = [f"the input '{name}'" for name in first.input_names]
    for label, own in zip(labels, power, strict=True):
        if own <= FAINT * power.max():
            raise RecordingError(
                f"{where}: {label} moves in none of the recordings, so nothing can be learnt of it; drive it, check "
                "its wiring, or leave it out."
            )
    check_separable(where, total, labels)
    for k, name in enumerate(first.output_names):
        if all(any(f.kind == "dead" and f.output == k for f in r.findings) for r in recordings):
            raise RecordingError(
                f"{where}: the output '{name}' follows the drives in none of the recordings; check the sensor's "
                "wiring, or leave it out."
            )


def _check_alike(first: Recording, other: Recording) -> None:
    counts = [(r.drive.shape[1], r.output.shape[1]) for r in (first, other)]
    if counts[0] != counts[1]:
        raise RecordingError(
            f"{other.path}: {counted(counts[1][0], 'input')} and {counted(counts[1][1], 'output')}, where "
            f"{first.path} has {counts[0][0]} and {counts[0][1]}; name the same channels in each "
            "recording, in the same order."
        )
