"""What a recording is, what a check found in it, and the error that refuses it."""

import hashlib
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from microrad.core.arrays import Floats
from microrad.core.errors import MicroradError
from microrad.core.units import printable

MIN_SAMPLES = 200

ACCEPTABLE = ("jitter", "clipping", "dead", "quantisation", "drift", "unexcited", "lead")

ROLES = ("loops", "broadband", "validation")
"""What a recording may be said to serve for: hysteresis, linear part, or the scores alone."""


@dataclass(frozen=True)
class Finding:
    """The evidence of one check on one channel.

    `kind` is the check (`drift`, `clipping`, ...), `channel` the name of the channel, `row` the first sample concerned
    counted from 0 (None where the whole record is meant), `message` the numbers and the remedy. `refused` is true
    where the finding is grounds for refusal; a recording that carries such a finding was taken on by `accept`. `output`
    is the number of the output, from 0, that was checked, None where it was an input or the time.
    """

    kind: str
    channel: str
    row: int | None
    message: str
    refused: bool
    output: int | None = None


class RecordingError(MicroradError):
    """A recording that cannot be used: the message names the file, the place, the fault and the remedy.

    `findings` holds the evidence where the checks of the values refused it.
    """

    page = "recordings"

    def __init__(self, message: str, findings: Sequence[Finding] = ()) -> None:
        """Keep the message, one line whatever names a file has, and the findings behind it."""
        super().__init__(printable(message, "\u00a0\u202f"))
        self.findings = tuple(findings)


@dataclass(frozen=True, eq=False)
class Recording:
    """Drives and outputs sampled together at a constant rate; the arrays are read-only.

    `drive` has the shape (samples, inputs) and `output` (samples, outputs), in the units of their source. `sha256` is
    the digest of the file's bytes, or of the arrays where they are a part of the file or there was none.
    `period_samples` is the length of one period where the excitation is periodic. `input_units` and `output_units` are
    the texts that the file states, '' where it states none, and empty tuples where nothing is known. `findings` is
    what the checks noticed and let pass. `role` is what it is to serve for, one of `ROLES`, or '' where its drive is
    to tell.
    """

    path: str
    sha256: str
    drive: Floats
    output: Floats
    rate_hz: float
    input_names: tuple[str, ...]
    output_names: tuple[str, ...]
    period_samples: int | None = None
    input_units: tuple[str, ...] = ()
    output_units: tuple[str, ...] = ()
    findings: tuple[Finding, ...] = ()
    role: str = ""

    @property
    def step_s(self) -> float:
        """Time between two samples."""
        return 1.0 / self.rate_hz

    @property
    def samples(self) -> int:
        """Number of samples."""
        return int(self.drive.shape[0])

    def first(self, samples: int) -> "Recording":
        """The first `samples` of it, or all where there are fewer."""
        return replace(self, drive=self.drive[:samples], output=self.output[:samples])


@dataclass(frozen=True, eq=False)
class Motion:
    """A recorded motion: `samples_rad` (samples, axes) at a constant rate, each axis by the name of its channel.

    `sha256` is the digest of the file's bytes.
    """

    path: str
    sha256: str
    names: tuple[str, ...]
    samples_rad: Floats
    rate_hz: float


@dataclass(frozen=True, eq=False)
class Signal:
    """One channel as it stands in a file: `samples` (samples,) in `unit`, '' where the file states none.

    `rate_hz` is None where nobody says it. `sha256` is the digest of the file's bytes.
    """

    path: str
    sha256: str
    name: str
    unit: str
    samples: Floats
    rate_hz: float | None


def frozen(values: Floats) -> Floats:
    """The same values, contiguous and read-only."""
    values = np.ascontiguousarray(values)
    values.flags.writeable = False
    return values


def digest_of(*arrays: Floats) -> str:
    """SHA-256 of the bytes of arrays, one behind the other, without copying contiguous ones."""
    digest = hashlib.sha256()
    for array in arrays:
        digest.update(np.ascontiguousarray(array).data)
    return digest.hexdigest()


_SPELLINGS = {"µrad": "urad", "μrad": "urad", "microrad": "urad", "µm": "um", "μm": "um", "volt": "V", "volts": "V"}
_KNOWN = ("V", "mV", "rad", "mrad", "urad", "m", "mm", "um")
_BRACKETS = re.compile(r"[(\[]\s*([^)\]]*?)\s*[)\]]\s*$")


def stated_units(units: Sequence[str], names: Sequence[str]) -> set[str]:
    """Units that a file states for its channels, by itself or in brackets behind a name it knows the unit of.

    Args:
        units: The units of the channels as the file states them, '' where it states none.
        names: The names of the channels.
    """
    said = {unit.strip() for unit in units if unit.strip()}
    if not said:
        behind = [found[1] for name in names if (found := _BRACKETS.search(name))]
        said = {unit for unit in behind if _SPELLINGS.get(unit, unit) in _KNOWN}
    return {_SPELLINGS.get(unit, unit) for unit in said}


def check_stated(recording: Recording, which: Literal["input", "output"], unit: str) -> None:
    """Check that the file of a recording states no other unit for its channels.

    Args:
        recording: The recording.
        which: Its drives or its outputs.
        unit: The unit in which they are to be read, spelled as in "V" or "urad".

    Raises:
        RecordingError: If the file states another one: the mirror would be larger or smaller than it is.
    """
    r = recording
    units, names = (r.input_units, r.input_names) if which == "input" else (r.output_units, r.output_names)
    said = stated_units(units, names)
    if said and said != {unit}:
        called = "drive" if which == "input" else "output"
        raise RecordingError(
            f"{r.path}: the {called} is to be read in {unit} and the file says {', '.join(sorted(said))}; give "
            "the unit that the file says, or convert its values."
        )


def read_in(recording: Recording, input_unit: str, output_unit: str) -> Recording:
    """The recording, where its file states no other units than those in which it is to be read.

    Args:
        recording: The recording.
        input_unit: Unit of its drives, spelled as in "V".
        output_unit: Unit of its outputs, spelled as in "urad".

    Raises:
        RecordingError: If its file states other units: the mirror would be larger or smaller than it is.
    """
    check_stated(recording, "input", input_unit)
    check_stated(recording, "output", output_unit)
    return recording
