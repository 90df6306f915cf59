"""A fine-pointing study as plain data: SI units, the unit in each key, None where a number has no value."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from microrad.loop.control import H_INFINITY_OF_AXES
from microrad.loop.controller_study import (
    AnyDesign,
    AnyScene,
    ErrorBudget,
    FinePointingStudy,
    Residual,
    Sine,
    Verified,
    families,
)
from microrad.loop.disturbance import ANGLE_OF_ARRIVAL
from microrad.mirror.geometry import StrokeBudget
from microrad.report.data import fields, finite
from microrad.report.fine_pointing.words import room


def fine_pointing_data(fine: FinePointingStudy, required: float) -> dict[str, Any]:
    """Everything that the page shows of the study, but its spectra, which results.nc holds.

    Args:
        fine: the study.
        required: largest radial error (rad) that is allowed for the mission's share of the time.
    """
    r, units = room(fine), parameter_units(fine.scene)
    stroke = {"point_ahead_on_mirror": fine.scene.stroke, "without_point_ahead": fine.scene.stroke_without_point_ahead}
    found: dict[str, Any] = {
        "quantile": fine.quantile,
        "required_rad": required,
        "best": fine.best.design.name,
        "baseline": r.baseline.design.name,
        "met": fine.best.meets(required) and not fine.scene.unknown_dynamics,
        "linear_bound_rms_rad": fine.optimum_rad,
        "linear_bound_holds": r.holds,
        "rms_gained_over_baseline": r.gained,
        "rms_left_to_gain": {
            "linear_at_baseline": r.at_baseline,
            "linear_at_nearest": r.at_nearest,
            "nearest": r.nearest.design.name,
            "baseline_with_hysteresis": r.with_hysteresis,
        },
        "controllers": [_controller(v, required, units) for v in fine.verified],
        "error_budget": _budget(fine.budget),
        "stroke": {name: [_stroke(axis) for axis in several] for name, several in stroke.items()},
        "sines": [_sine(s, required) for s in fine.sines],
    }
    found |= arrival(fine.scene)
    plain: dict[str, Any] = finite(found)
    return plain


def arrival(scene: AnyScene) -> dict[str, Any]:
    """The angle of arrival of an axis before the loop, by its key; nothing where the loop has none."""
    here = [each for each in scene.loop.disturbances[0] if each.name == ANGLE_OF_ARRIVAL]
    return {"angle_of_arrival": fields(here[0], "rms_rad", "basis", "source")} if here else {}


def parameter_units(scene: AnyScene) -> dict[str, str]:
    """Units of the parameters that controllers are tuned by, by name, alone or with that of a loop; "" is plain.

    Args:
        scene: the loop that they are tuned for.
    """
    plant, loops = scene.one_axis, ("", " x", " y", " 1", " 2")
    units: dict[str, str] = {}
    for family in (*families(scene.table), H_INFINITY_OF_AXES):
        try:
            units |= {f"{p.name}{loop}": p.unit for p in family.parameters(plant) for loop in loops}
        except ValueError:  # this plant has no such controller
            continue
    return units


def rms_by_source(v: Verified) -> dict[str, float]:
    """Radial rms (rad) in theory by source of error."""
    return {name: math.sqrt(float(np.sum(variance))) for name, variance in v.theory.error_by_source.items()}


def sources(verified: Sequence[Verified]) -> tuple[str, ...]:
    """All sources of error that theory knows, in its order."""
    return tuple(dict.fromkeys(name for v in verified for name in v.theory.error_by_source))


def _controller(v: Verified, required_rad: float, units: dict[str, str]) -> dict[str, Any]:
    return {
        "name": v.design.name,
        "inverse": v.design.inverse,
        "parameters": [
            {"name": name, "unit": units.get(name, ""), "value": value} for name, value in v.design.values.items()
        ],
        "bound_by": list(v.design.bound_by),
        "theory_rms_rad": v.theory.radial_rms_rad,
        "theory_rms_by_source_rad": rms_by_source(v),
        "simulated": {name: _residual(residual, required_rad) for name, residual in v.simulated.items()},
        "margins": margins(v.design),
    }


def margins(design: AnyDesign) -> dict[str, float]:
    """Margins and reach of a design's nominal loop, by key with its unit."""
    of = design.loop_margins
    return {
        "modulus": of.modulus,
        "gain_up_db": 20.0 * math.log10(of.gain_up),
        "phase_rad": of.phase_rad,
        "delay_s": of.delay_s,
        "disk": of.disk,
        "bandwidth_hz": of.bandwidth_hz,
        "crossover_hz": of.crossover_hz,
    }


def _sine(s: Sine, required_rad: float) -> dict[str, Any]:
    errors = {"frequency_hz": s.freq_hz, "rms_rad": s.rms_rad, "quantile_rad": s.quantile_rad}
    return {"controller": s.controller, "mirror": s.variant, **errors, "met": s.quantile_rad <= required_rad}


def _residual(residual: Residual, required_rad: float) -> dict[str, Any]:
    return {
        **fields(residual, "rms_rad", "rms_interval_rad", "axis_rms_rad", "quantile_rad", "largest_rad"),
        "met": residual.quantile_rad <= required_rad,
        "shares": dict(residual.shares),
    }


def _budget(budget: ErrorBudget) -> dict[str, Any]:
    return {
        "controller": budget.controller,
        "parts": [{"name": p.name, "rms_rad": p.rms_rad, "theory_rms_rad": p.theory_rad} for p in budget.parts],
        "combined_rms_rad": budget.combined_rad,
        "together_without_hysteresis_rms_rad": budget.together_rad,
        "full_rms_rad": budget.full_rad,
        "linear": budget.linear,
        "dominant": budget.dominant,
        "differences": [
            {"name": d.name, "with_rms_rad": d.with_rad, "without_rms_rad": d.without_rad, "added_rms_rad": d.added_rad}
            for d in budget.differences
        ],
    }


def _stroke(axis: StrokeBudget) -> dict[str, Any]:
    return {
        "axis": axis.name,
        "lines_rad": {line.name: line.value for line in axis.lines},
        **fields(axis, "total_rad", "total_rss_rad", "mirror_per_line_of_sight"),
        "mirror_angle": axis.travel_angle,
        **fields(axis, "needed_rad", "needed_rss_rad", "travel_rad", "available_rad", "margin_rad", "margin_rss_rad"),
        **fields(axis, "fits", "fits_rss", "largest_magnification", "largest_magnification_rss"),
    }
