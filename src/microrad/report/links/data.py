"""The links as plain data, in SI units with the unit in each key."""

import math
from dataclasses import asdict
from typing import Any

from microrad.core.budget import Line
from microrad.link import Swing
from microrad.link.acquisition.partner_search import Finding, Found, Tracking
from microrad.link.compliance import Compliance
from microrad.link.fade_series.coded import CodedFading
from microrad.link.pointing import OpenLoopPointing
from microrad.link.pointing.outage import Performance
from microrad.link.requirement import met, of_links
from microrad.link.study import LinkStudy, Solution
from microrad.report.data import fields
from microrad.report.links.ground import ground_data
from microrad.report.links.standard import standard_data
from microrad.report.marks import with_marks
from microrad.report.requirements import requirement_data


def links_data(study: LinkStudy, solution: Solution | None = None, against: Compliance | None = None) -> dict[str, Any]:
    """The verdict on the links, their budgets and what follows from them, after the values that were solved for.

    Args:
        study: the links, at their budgeted errors or under their jitter.
        solution: the values of a key that leave the required margin, if one was solved for.
        against: a standard with what the links have of it, if one was asked for.
    """
    judged = [requirement_data(r) for r in of_links(study)]
    solved = {} if solution is None else {"solved": _solution_data(solution)}
    found = {"closes": study.closes, "met": met(study), "requirements": judged, **solved, **budgets_data(study)}
    found |= {} if against is None else {"standard": standard_data(against)}
    return with_marks(found, study.file.sources)


def _solution_data(s: Solution) -> dict[str, Any]:
    ends = [[None if i.low_open else i.low, None if i.high_open else i.high] for i in s.solved.intervals]
    best = {"value": s.solved.best, "margin_db": s.solved.best_db}
    found = {"key": s.key, "unit": s.unit, "of": s.of, "required_db": s.required_db}
    return {**found, "intervals": ends, "searched": list(s.solved.searched), "value": s.value, "best": best}


def budgets_data(study: LinkStudy) -> dict[str, Any]:
    """The budgets and what follows from them as plain data, without a verdict of their own."""
    return {
        "mission": study.file.mission.name,
        "mission_sha256": study.file.sha256,
        "budgets": [
            {
                **fields(b, "name", "margin_db", "received_power_w", "required_power_w", "received_photons_per_bit"),
                **fields(b, "irradiance_w_m2", "irradiance_on_axis_w_m2"),
                **fields(b, "radiant_intensity_w_sr", "required_irradiance_w_m2"),
                "lines": [line_data(line) for line in b.lines],
                "totals": [line_data(line) for line in b.totals],
                "warnings": list(b.warnings),
            }
            for b in study.budgets
        ],
        "largest_data_rate_bit_s": study.largest_rate_bit_s,
        "tornado": [_swing_data(s) for s in study.tornados[0].swings],
        "other_tornados": [
            {"of": t.of, "margin_db": t.margin_db, "tornado": [_swing_data(s) for s in t.swings]}
            for t in study.tornados[1:]
        ],
        "pointing": None if study.open_loop is None else _open_loop(study.open_loop),
        "point_ahead": None if study.point_ahead is None else asdict(study.point_ahead),
        "receiver_noise": [line_data(line) for line in study.receiver_noise],
        "tracking": None if study.tracking is None else _tracking(study.tracking),
        "acquisition": None if study.finding is None else finding_data(study.finding),
        "under_jitter": None if study.under_jitter is None else performance_data(study.under_jitter),
        **({} if study.fading is None else {"fading": fading_data(study.fading)}),
        **({} if study.ground is None else {"ground": ground_data(study.ground)}),
        "warnings": list(study.warnings),
    }


def fading_data(f: CodedFading) -> dict[str, Any]:
    """The coded link under a series of received power; a cost that no power makes up for is none."""
    return {
        **fields(f, "code", "source", "target", "interleaving", "span_s", "window_s", "words"),
        "bit_error_ratio": f.ratio.value,
        "bit_error_ratio_interval": [f.ratio.low, f.ratio.high],
        "lost": f.lost.value,
        "lost_interval": [f.lost.low, f.lost.high],
        "penalty_db": f.penalty_db,
        "static_margin_db": f.margin_db,
        "margin_db": f.margin_left_db,
        "fades": {
            "level_db": 10.0 * math.log10(f.fades.level),
            "per_s": f.fades.per_second,
            **fields(f.fades, "share", "mean_s", "median_s", "ninetieth_s", "longest_s", "unresolved"),
        },
        "curve": {"span_s": list(f.curve.span_s), "penalty_db": list(f.curve.penalty_db)},
    }


def _open_loop(p: OpenLoopPointing) -> dict[str, Any]:
    """The pointing budget, with what the beacon's half angle leaves for each line by root sum square."""
    left = () if p.reading is None else p.allocation(p.reading.half_angle_rad, "rss")
    return {
        "lines": [line_data(line) for line in p.lines],
        "confidence": p.confidence,
        "totals": [fields(s, "rule", "of", "total_rad", "authority", "caveat") for s in p.summations],
        "beacon_coverage": None if p.reading is None else p.reading.coverage,
        "left_for_each": [fields(each, "name", "largest_rad", "missing_rad") for each in left],
    }


def _swing_data(s: Swing) -> dict[str, Any]:
    values = fields(s, "unit", "value", "low", "high", "margin_low_db", "margin_high_db", "source")
    return {"input": s.key, **values}


def line_data(line: Line) -> dict[str, Any]:
    """A line of a budget."""
    texts = fields(line, "name", "value", "unit", "basis", "source")
    return {**texts, "holds_for": line.regime, "warning": line.warning}


def _tracking(t: Tracking) -> dict[str, Any]:
    angle = t.noise_equivalent_angle
    return {
        **fields(t, "power_w", "signal_to_noise"),
        "noise_equivalent_angle_rad": None if angle is None else angle.value,
        "lines": [line_data(line) for line in t.noise_lines],
    }


def performance_data(p: Performance) -> dict[str, Any]:
    """The link under one distribution of pointing errors."""
    return {
        **fields(p, "source", "controller", "mirror"),
        "bias_rad": list(p.jitter.bias_rad),
        "rms_rad": list(p.jitter.rms_rad),
        **fields(p, "mean_loss_db", "outage_loss_db", "margin_db", "outage"),
        "below_required_margin": p.short,
        "data_rate_bit_s": p.data_rate_bit_s,
        "best_half_angle_rad": p.best.half_angle_rad,
        "wanted_half_angle_rad": p.best.wanted_half_angle_rad,
        "lost_against_best_db": p.best.current_excess_db,
        "coded_penalty_many_fades_db": p.mean_loss_db,
        "coded_penalty_no_interleaver_db": p.outage_loss_db,
        **fields(p, "uncoded_penalty_db", "fades_per_s"),
        "mean_fade_s": p.fade_s,
    }


def finding_data(f: Finding) -> dict[str, Any]:
    """The search for the partner; what never locks has no times."""
    s = f.scanned
    return {
        "uncertainty_per_axis_rad": f.sigma_rad,
        **fields(f.chances, "beacon_coverage", "answer_coverage", "answer_detection", "return_coverage"),
        "scan_s": None if s is None or not s.detects else s.duration_s,
        "scan_radius_rad": None if s is None else s.radius_rad,
        "scan_half_angle_rad": None if s is None else s.half_angle_rad,
        "scan_stated_detection_s": None if s is None else s.stated_detection_s,
        "scan_needed_detection_s": None if s is None or not s.detects else s.needed_detection_s,
        "ways": [_way_data(w) for w in f.ways],
    }


def _way_data(w: Found) -> dict[str, Any]:
    return {
        "name": w.name,
        "success_probability": w.outcome.success_probability,
        "mean_time_s": w.outcome.mean_time_s if w.possible else None,
        "simulated_success_probability": w.simulated_probability,
        "simulated_mean_time_s": w.simulated_mean_s if w.simulated.locked.any() else None,
        "runs": int(w.simulated.locked.size),
        "stages": [fields(each, "name", "longest_s", "success_probability") for each in w.stages],
    }
