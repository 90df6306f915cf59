"""The units that a file states for its channels, and the refusal of a recording that is read in others."""

from __future__ import annotations

import re
from collections.abc import Sequence

from microrad.lab.recording.records import Recording, RecordingError

_SPELLINGS = {"µrad": "urad", "μrad": "urad", "microrad": "urad", "µm": "um", "μm": "um", "volt": "V", "volts": "V"}
_KNOWN = ("V", "mV", "rad", "mrad", "urad", "m", "mm", "um")
_BRACKETS = re.compile(r"[(\[]\s*([^)\]]*?)\s*[)\]]\s*$")


def stated_units(units: Sequence[str], names: Sequence[str]) -> set[str]:
    """Units that a file states for its channels, by itself or in brackets behind a name it knows the unit of."""
    said = {unit.strip() for unit in units if unit.strip()}
    if not said:
        behind = [found[1] for name in names if (found := _BRACKETS.search(name))]
        said = {unit for unit in behind if _SPELLINGS.get(unit, unit) in _KNOWN}
    return {_SPELLINGS.get(unit, unit) for unit in said}


def read_in(recording: Recording, input_unit: str, output_unit: str) -> Recording:
    """The recording, whose drives are read in one unit and whose outputs in another, both spelled as in "V" and "urad".

    Raises `RecordingError` where its file states other units: the mirror would be larger or smaller than it is.
    """
    r = recording
    for which, given, units, names in (
        ("drive", input_unit, r.input_units, r.input_names),
        ("output", output_unit, r.output_units, r.output_names),
    ):
        said = stated_units(units, names)
        if said and said != {given}:
            raise RecordingError(
                f"{r.path}: the {which} is to be read in {given} and the file says {', '.join(sorted(said))}; give "
                "the unit that the file says, or convert its values."
            )
    return r
