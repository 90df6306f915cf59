"""The validated domain of mirror models: what the recordings excited on which a model's error was measured."""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from microrad.core.arrays import Floats
from microrad.lab.recording import Recording
from microrad.report.registry import quantity_of
from microrad.report.verification.check import Outcome
from microrad.report.verification.checks.measured import HELD_OUT
from microrad.report.verification.workspace import Workspace

EXCITED = 0.1
"""Share of the largest line of a drive's spectrum from which on a frequency counts as excited."""
_ERROR = "identify.linear.held_out"


def recorded(workspace: Workspace, outcomes: Sequence[Outcome]) -> dict[str, Any]:
    """For each check that compares a mirror model with recordings that are here: what they excited, and the error.

    Args:
        workspace: Its folder of recordings.
        outcomes: Of the checks that were run; those that hold none of the comparisons or did not run are left out.
    """
    found = {}
    for outcome in outcomes:
        held_out = HELD_OUT.get(outcome.check.name)
        errors = [c for c in outcome.comparisons if quantity_of(c.quantity) is quantity_of(_ERROR)]
        if held_out is None or not errors or not outcome.holds:
            continue
        records = held_out.records(workspace)
        found[outcome.check.name] = {
            "part": held_out.part,
            "records": list(held_out.files),
            "inputs": records[0].drive.shape[1],
            "outputs": records[0].output.shape[1],
            "extents": extents(records, held_out.metres),
            "frequencies": list(held_out.frequencies),
            "errors": [
                {
                    "what": c.what,
                    "unit": c.unit,
                    "error": float(f"{c.obtained:.3g}"),
                    "allowed": float(f"{c.tolerance:.3g}"),
                }
                for c in errors
            ],
        }
    return found


def extents(records: Sequence[Recording], metres: float) -> dict[str, Any]:
    """Between which values records lie: amplitude of the drive, excited frequencies, sample rate, span of position.

    The amplitude is half of a channel's span. A frequency is excited where the amplitude spectrum of a drive, its mean
    taken out, has at least a tenth of its largest line: over whole periods where the drive is periodic, else behind a
    Hann window.

    Args:
        records: Those that were held out.
        metres: Of one unit of their outputs.
    """
    channels = [(record, drive) for record in records for drive in record.drive.T]
    outputs = [output for record in records for output in record.output.T]
    return {
        "drive": _extent("V", [float(np.ptp(drive)) / 2.0 for _, drive in channels]),
        "frequency": _extent("Hz", [hertz for each in channels for hertz in _excited_hz(*each)]),
        "rate": _extent("Hz", [record.rate_hz for record in records]),
        "position": _extent("m", [float(np.ptp(output)) * metres for output in outputs]),
    }


def _excited_hz(record: Recording, drive: Floats) -> Iterator[float]:
    """The lowest and the highest frequency that a drive excites; nothing where it stands still."""
    period = record.period_samples
    samples = drive.size - drive.size % period if period else drive.size
    window = np.ones(samples) if period else np.hanning(samples)
    lines = np.abs(np.fft.rfft((drive[:samples] - drive[:samples].mean()) * window))
    excited = np.flatnonzero((lines >= EXCITED * lines.max()) & (lines > 0.0))
    yield from (float(place) * record.rate_hz / samples for place in (*excited[:1], *excited[-1:]))


def _extent(unit: str, values: Sequence[float]) -> dict[str, Any]:
    return {"unit": unit, "least": float(f"{min(values):.4g}"), "most": float(f"{max(values):.4g}")}
