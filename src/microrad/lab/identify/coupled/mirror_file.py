"""The mirror file of an identification of several channels: where it comes from, and the model."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace

from microrad.lab.identify.coupled.records import CoupledIdentification
from microrad.lab.identify.records import IdentificationError
from microrad.lab.recording import Recording
from microrad.mirror import coupled


def coupled_file_text(found: CoupledIdentification, recordings: Sequence[Recording], name: str) -> str:
    """Text of the mirror file, version 2, of the model that was chosen.

    Args:
        found: What was found.
        recordings: The recordings that it was found from, those for validation included.
        name: Name of the mirror.

    Raises:
        IdentificationError: For a blank name.
    """
    if not name.strip():
        raise IdentificationError("the mirror has no name; give one, it stands in the mirror file and in the report.")
    model = found.candidate().model
    named = replace(model, mirror=replace(model.mirror, name=name))
    return coupled.text(named, list(_origin(found, recordings)))


def _origin(found: CoupledIdentification, recordings: Sequence[Recording]) -> Iterator[str]:
    """Lines that say what the model was found from, and how good it is."""
    own = found.candidate()
    yield f"Mirror identified from {len(recordings)} recording(s), model {found.chosen}."
    held = set(found.held_out)
    for recording in recordings:
        yield f"  {recording.path} ({'held out' if recording.path in held else 'fitted'})"
        yield f"  sha256 {recording.sha256}"
    yield f"{own.parameters} parameters; error on held-out records {100 * own.error_share:.3g} % of the output (rms)."
    for volts, errors in zip(found.amplitudes_v, own.error_rms, strict=True):
        if not all(map(math.isnan, errors)):
            listed = ", ".join(f"{error:.3g}" for error in errors)
            yield f"  at {volts:.3g} V rms: {listed} {_unit(found)} (rms, by output)"
    if found.stopped:
        yield "The identification was stopped before its end: larger models were not fitted."
    yield f"Choice: {found.reason}"
    yield from (f"Warning: {warning}" for warning in found.warnings)
    yield from (f"Not fitted: {refused.model}, {refused.reason}" for refused in found.refused)


def _unit(found: CoupledIdentification) -> str:
    return "m" if found.candidate().model.outputs[0].quantity == "displacement" else "rad"
