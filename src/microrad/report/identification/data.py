"""An identification as plain data."""

from dataclasses import asdict
from pathlib import Path
from typing import Any

from microrad.lab.identify import Identification, PrandtlIshlinskiiFit, Score
from microrad.lab.identify.hysteresis.joint import JointFit
from microrad.lab.identify.linear.fit import LinearFit
from microrad.lab.identify.selection.predictions import Fit
from microrad.mirror.hysteresis import PrandtlIshlinskii
from microrad.report.data import fields, finite
from microrad.report.identification import words
from microrad.report.identification.parameters import (
    admissible,
    colour,
    condition_number,
    not_identified,
    parameter_rows,
    starts,
)


def identification_data(
    found: Identification, written: str, *, mirror_file: Path | None = None, report_file: Path | None = None
) -> dict[str, Any]:
    """The identification as plain data, in SI units with the unit in each key; what is not finite is None.

    Args:
        found: what was identified.
        written: the model in the mirror file.
        mirror_file: the mirror file, if one was written.
        report_file: the report, if one was written.
    """
    names = [score.model for score in found.scores]
    data = {
        "model": written,
        "best_model": found.chosen,
        "verdict": words.verdict(found, written),
        "reason": found.reason,
        "scores": [_score_data(score, found.span_rad) for score in (*found.scores, found.straight_line)],
        "parameters": {name: _parameter_data(fit) for name, fit in zip(names, found.fits, strict=True)},
        "refused": {refused.model: refused.reason for refused in found.refused},
        "linear": None if found.linear is None else _linear_data(found.linear),
        "residual": _residual_data(found),
        "span_rad": found.span_rad,
        "travel_rad": found.travel_rad,
        "drive_min_v": found.drive_min_v,
        "drive_max_v": found.drive_max_v,
        "rate_limit_v_s": found.rate_limit_v_per_s,
        "full_range_hz": words.full_range_hz(found),
        "drift_rad": found.drift_rad,
        "recordings": [asdict(source) for source in found.sources],
        "warnings": words.warnings(found, written),
        "mirror_file": None if mirror_file is None else str(mirror_file),
        "report_file": None if report_file is None else str(report_file),
    }
    plain: dict[str, Any] = finite(data)
    return plain


def _score_data(score: Score, span_rad: float) -> dict[str, Any]:
    share, rms = span_rad / 100, ("fit_rms", "held_out_rms")
    return asdict(score) | {f"{key}_rad": share * getattr(score, f"{key}_percent") for key in rms}


def _parameter_data(fit: Fit) -> dict[str, Any]:
    found = starts(fit)
    common = {
        "admissible": admissible(fit),
        "not_identified": dict(not_identified(fit)),
        "agreeing_starts": None if found is None else found[0],
        "starts": None if found is None else found[1],
        "condition_number": condition_number(fit),
        "colour_inflation": colour(fit),
    }
    if isinstance(fit, PrandtlIshlinskiiFit):
        return common | {
            "thresholds_v": fit.thresholds_v.tolist(),
            "weights_rad_v": fit.weights_rad_per_v.tolist(),
            "standard_errors_rad_v": fit.standard_errors_rad_per_v.tolist(),
            "sign": fit.sign,
        }
    values: dict[str, Any] = {row.name: fields(row, "value", "standard_error", "unit") for row in parameter_rows(fit)}
    if isinstance(fit, JointFit) and isinstance(fit.model, PrandtlIshlinskii):
        values["thresholds_v"] = list(fit.model.thresholds_v)
    return common | values


def _linear_data(linear: LinearFit) -> dict[str, Any]:
    return {
        **fields(linear, "order", "reason"),
        "fit_percent": float(linear.fit_percent[0]),
        "residual_rms_rad": float(linear.residual_rms[0]),
        "excited_hz": list(linear.excited_hz),
        "rate_hz": linear.rate_hz,
        "dc_gain_rad_v": float(linear.dc_gain[0, 0]),
        "dc_gain_standard_error_rad_v": float(linear.dc_gain_error[0, 0]),
        "edge_gain_rad_v": float(linear.edge_gain[0, 0]),
        "edge_gain_standard_error_rad_v": float(linear.edge_gain_error[0, 0]),
        "poles_and_zeros": [asdict(root) for root in words.roots(linear)],
        "orders": [asdict(score) for score in linear.scan],
    }


def _residual_data(found: Identification) -> dict[str, Any]:
    test = found.residual
    return {
        **fields(test, "samples", "bound", "white"),
        "independent_of_drive": test.independent,
        "share_of_autocorrelations_outside": test.outside[0],
        "share_of_cross_correlations_outside": test.outside[1],
        "autocorrelation": test.autocorrelation.tolist(),
        "cross_correlation": test.cross_correlation.tolist(),
    }
