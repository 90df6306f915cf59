"""Laboratory recordings: read from the formats of a laboratory, checked, and refused with the place that is wrong.

Columns are named or numbered from 0. Lines of a text are counted from 1, as a text editor counts them, samples from 0.
The values keep the units of the file; `identify` is told what they are. `list_file` reads a list of recordings.
"""

from microrad.lab.recording.checks.together import check_together
from microrad.lab.recording.reader import read_motion, read_recording, read_signal, recording_from_arrays
from microrad.lab.recording.realisations import AXES, multisine_recordings, read_arrays
from microrad.lab.recording.records import (
    ACCEPTABLE,
    MIN_SAMPLES,
    ROLES,
    Finding,
    Motion,
    Recording,
    RecordingError,
    Signal,
    read_in,
    stated_units,
)

__all__ = [
    "ACCEPTABLE",
    "AXES",
    "MIN_SAMPLES",
    "ROLES",
    "Finding",
    "Motion",
    "Recording",
    "RecordingError",
    "Signal",
    "check_together",
    "multisine_recordings",
    "read_arrays",
    "read_in",
    "read_motion",
    "read_recording",
    "read_signal",
    "recording_from_arrays",
    "stated_units",
]
