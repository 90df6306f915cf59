"""An identification of several channels as plain data."""

from dataclasses import asdict
from pathlib import Path
from typing import Any

from microrad.lab.identify.coupled import Candidate, CoupledIdentification
from microrad.report.data import fields, finite
from microrad.report.identification import coupled_words as words


def coupled_identification_data(
    found: CoupledIdentification, *, mirror_file: Path | None = None, report_file: Path | None = None
) -> dict[str, Any]:
    """The identification as plain data, in SI units with the unit in each key; what is not finite is None.

    Lists by amplitude have the order of `amplitudes_rms_v`, in them lists by band that of `bands_hz`, and the
    innermost the order of `outputs`.

    Args:
        found: what was identified.
        mirror_file: the mirror file, if one was written.
        report_file: the report, if one was written.
    """
    own, unit = found.candidate(), words.unit_of(found)
    record, output, share = words.worst(found)
    dependence, (floor, noise) = found.dependence, words.band_floors(found)
    data = {
        "model": found.chosen,
        **fields(found, "stopped", "reason", "warnings"),
        "verdict": words.verdict(found),
        "worst": {"record": record, "output": output, "error_share": share},
        "within_noise": list(found.within_noise),
        "candidates": [_candidate_data(candidate, found) for candidate in found.candidates],
        "refused": {refused.model: refused.reason for refused in found.refused},
        "amplitudes_rms_v": found.amplitudes_v.tolist(),
        "bands_hz": found.bands_hz.tolist(),
        f"output_rms_{unit}": found.output_rms.tolist(),
        f"noise_rms_{unit}": found.noise_rms.tolist(),
        f"linear_floor_rms_{unit}": words.linear_floor(found).tolist(),
        f"linear_floor_band_rms_{unit}": floor.tolist(),
        f"noise_band_rms_{unit}": noise.tolist(),
        "amplitude_dependence": None
        if dependence is None
        else {
            "drive_rms_v": dependence.drive_rms.tolist(),
            f"gain_{unit}_v": dependence.gain.tolist(),
            "resonance_hz": dependence.resonance_hz.tolist(),
            "resonance_standard_error_hz": dependence.resonance_error_hz.tolist(),
            "damping_ratio": dependence.damping_ratio.tolist(),
        },
        "responses": [None if r is None else fields(r, "method", "excited_hz") for r in found.responses],
        "actuators": [asdict(actuator) for actuator in own.model.actuators],
        "outputs": [asdict(output) for output in own.model.outputs],
        "excited_hz": list(own.model.excited_hz),
        "rate_hz": own.model.rate_hz,
        "steps_per_sample": own.model.steps_per_sample,
        "delay_s": own.model.delay_s,
        "fitted": list(found.fitted),
        "held_out": list(found.held_out),
        "not_in_the_mirror_file": words.not_held(found),
        "mirror_file": None if mirror_file is None else str(mirror_file),
        "report_file": None if report_file is None else str(report_file),
    }
    plain: dict[str, Any] = finite(data)
    return plain


def _candidate_data(candidate: Candidate, found: CoupledIdentification) -> dict[str, Any]:
    unit = words.unit_of(found)
    return {
        **fields(candidate, "name", "kind", "order", "parameters", "error_share"),
        "error_share_by_amplitude": words.shares(candidate, found).tolist(),
        f"error_rms_{unit}": candidate.error_rms.tolist(),
        f"band_error_rms_{unit}": candidate.band_error_rms.tolist(),
        "record_error_share": dict(zip(found.held_out, candidate.record_share.tolist(), strict=True)),
        "delay_s": candidate.model.delay_s,
        "delay_standard_error_s": candidate.delay_error_s,
        "poles": [
            {
                "frequency_hz": pole.freq_hz,
                "frequency_standard_error_hz": pole.freq_error_hz,
                "damping_ratio": pole.damping,
                "damping_standard_error": pole.damping_error,
                "excited": pole.excited,
            }
            for pole in words.poles(candidate)
        ],
        "note": candidate.note,
    }
