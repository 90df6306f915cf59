"""A study as plain data."""

from typing import Any

from microrad.loop.paper_cases import Run
from microrad.report.data import fields
from microrad.report.day.constellation import plan_data
from microrad.report.day.contact_run import contact_run_data
from microrad.report.day.data import day_data
from microrad.report.error_budget.data import budget_data
from microrad.report.fine_pointing.data import fine_pointing_data
from microrad.report.links.data import budgets_data, performance_data
from microrad.report.marks import with_marks
from microrad.report.requirements import requirement_data
from microrad.report.study import words
from microrad.study.study import Study


def summary(study: Study) -> dict[str, Any]:
    """The study as plain data, in SI units with the unit in each key."""
    m, fine = study.file.mission, study.fine_pointing
    found = {
        "mission": m.name,
        "mission_sha256": study.file.sha256,
        "closes": study.closes,
        "met": study.met,
        "verdict": words.headline(study),
        "margin_db": {
            "judged": study.margin_db,
            "beacon": study.beacon.margin_db,
            "answer": study.answer.margin_db,
            "communication_as_budgeted": study.communication.margin_db,
            "communication_static": study.static.margin_db,
            "communication_at_residual": study.achieved.margin_db,
        },
        "residual": {
            "controller": study.residual.controller,
            "frequency_hz": study.residual.freq_hz,
            "peak_rad": study.residual.trace.peak_rad,
            "rms_rad": study.residual.trace.rms_rad,
            "statistic": m.requirement.residual_statistic,
            "convention": m.conventions.residual,
            "used_rad": study.left_rad(study.residual),
        },
        "largest_data_rate_bit_s": study.margin_map.largest_rate_bit_s,
        "largest_pointing_error_rad": study.margin_map.largest_error_rad,
        "implied_sensitivity_photon_bit": [r.photons_per_bit for r in study.margin_map.readings],
        "requirements": [requirement_data(r) for r in study.requirements],
        "papers_loop": [requirement_data(r) for r in study.papers_loop],
        "runs": [_run_data(r) for r in study.runs],
        "paper": [fields(c, "where", "claim", "ours", "agrees", "why") for c in study.claims],
        "other_readings": [
            fields(r, "key", "given", "other", "residual_rad", "margin_db", "failure") for r in study.other_readings
        ],
        "links": budgets_data(study.links),
        "performance": [performance_data(each) for each in study.performance.cases],
        "hysteresis_costs": [
            {
                **fields(c, "source", "controller", "mirror"),
                "margin_change_db": c.margin_db,
                "data_rate_change_bit_s": c.data_rate_bit_s,
            }
            for c in study.performance.costs
        ],
        "day": None if study.day is None else day_data(study.day),
        "contact": None if study.contact is None else contact_run_data(study.contact),
        "constellation": None if study.plan is None else plan_data(study.plan),
        "fine_pointing": None if fine is None else fine_pointing_data(fine, m.requirement.pointing_error_rad),
        **({} if study.error_budget is None else {"error_budget": budget_data(study.error_budget)}),
        "warnings": words.warnings(study),
    }
    return with_marks(found, study.file.sources)


def _run_data(run: Run) -> dict[str, Any]:
    counts = run.trace.counts
    return {
        **fields(run, "mirror", "controller"),
        "frequency_hz": run.freq_hz,
        **fields(run.trace, "peak_rad", "rms_rad"),
        "rate_clamped": counts.clamped + counts.inverse_clamped,
        **fields(counts, "saturated", "slew_limited", "alternating"),
    }
