"""The verdict by requirement: its margin and what contributes most to it, with the numbers of the budgets."""

import math
from collections.abc import Callable, Mapping, Sequence

from microrad import link
from microrad.link.budget.lines import FREE_SPACE_LOSS, POINTING_LOSS
from microrad.link.error_budget.assembly import Judged, size_key
from microrad.link.requirement import Requirement, Subject
from microrad.loop.controller_study.parts import GAUGE_NOISE, OPTICAL_NOISE
from microrad.mirror import Variant
from microrad.mirror.geometry import StrokeBudget
from microrad.report.error_budget.words import most
from microrad.report.fine_pointing.words import source_name
from microrad.report.quantities import percent, quantity
from microrad.report.requirements import (
    advice_for_links,
    advice_for_power,
    advise_at_most,
    advise_change,
    requirement_table,
)
from microrad.report.tables import Cell, Table
from microrad.study.alternatives import Reading
from microrad.study.study import Study
from microrad.study.verdict import unknown

_OF_NOISE = {OPTICAL_NOISE: "fine_pointing.optical_sensor", GAUGE_NOISE: "fine_pointing.strain_gauge"}
_BY_TEN = ("bit_error_ratio", "outage")  # inputs that a tornado moves by their order of magnitude


def judged_table(study: Study, found: Sequence[Requirement]) -> Table:
    """Requirements with what contributes most to each.

    Args:
        study: a run of a whole mission.
        found: requirements of it.
    """
    name = "requirements" if found is study.requirements else "papers_loop"
    return requirement_table(found, [contributor(study, r) for r in found], name)


def readings_table(study: Study) -> Table:
    """The numbers that rest on the residual by each other reading; first as the mission has them."""
    m = study.file.mission
    left, margin = study.left_rad(study.residual), study.achieved.margin_db
    own = Reading("as it stands", "", "", left, margin)
    rows = [_reading(r, r.meets(m.requirement) and not unknown(m.mirror)) for r in (own, *study.other_readings)]
    headings = ("key", "read as", "instead", "residual", "margin", "link closes", "residual and margin as required")
    names = {3: "other_readings.residual_rad", 4: "other_readings.margin_db"}
    return Table("", headings, rows, (0, 1, 2, 5, 6), best=(0,), names=names)


def _reading(r: Reading, met: bool) -> list[str | Cell]:
    key = Cell(r.key, code=bool(r.other))
    if r.failure:
        return [key, r.given, r.other, r.failure, "", "", ""]
    numbers = quantity(r.residual_rad, "rad"), quantity(r.margin_db, "dB"), "yes" if r.closes else "no"
    return [key, r.given, r.other, *numbers, Cell("", "PASS" if met else "FAIL")]


def contributor(study: Study, r: Requirement) -> str:
    """What contributes most to a requirement, with its numbers.

    Args:
        study: a run of a whole mission.
        r: a requirement of it.
    """
    fine = study.fine_case is not None and r in study.requirements
    if r.subject == "error budget":
        said = r.unknown or most(_judged(study, r))
    else:
        said = r.unknown or (_OF_FINE if fine else _CONTRIBUTORS)[r.subject](study, r.limited_by)
    return f"{said[:1].upper()}{said[1:]}"


def _cone(study: Study) -> str:
    p = study.open_loop
    share, line = max(zip(p.variance_shares, p.lines, strict=True), key=lambda pair: pair[0])
    assert p.reading is not None  # a whole mission has a beacon
    said = f"{line.name}: {percent(share)} of the sum of squares, {quantity(line.value, 'rad')} half width"
    half = quantity(p.reading.half_angle_rad, "rad")
    return f"{said}; the cone of {half} half angle covers its partner with a probability of {p.reading.coverage:.2f}"


def advice(study: Study, r: Requirement) -> str:
    """What to change for a requirement that the verdict judges, as the end of a sentence, or nothing.

    Args:
        study: a run of a whole mission.
        r: a requirement of it.
    """
    m = study.file.mission
    if r.unknown:
        return ""
    if r.subject == "communication":
        return advice_for_power(m.communication, r, study.tornado)
    if own := {"stroke": _of_stroke, "error budget": _of_source}.get(r.subject):
        return own(study, r)
    if r.subject == "fine pointing":
        noise = _OF_NOISE.get(r.limited_by)
        return advise_change(r, noise) if noise else advise_change(r, "fine_pointing.rate", "raise")
    if r.subject == "residual":
        held = "amplifier.slew" if "slew limit" in r.limited_by else "amplifier.output_max"
        return advise_change(r, held if r.limited_by.startswith("the amplifier") else "control.integral", "raise")
    return advice_for_links(study.links, r)


def _judged(study: Study, r: Requirement) -> Judged:
    """What the budget of pointing errors, which there is, has for a requirement of it."""
    assert study.error_budget is not None
    own = [each for each in study.requirements if each.subject == "error budget"]
    return study.error_budget.judged[own.index(r)]


def _of_source(study: Study, r: Requirement) -> str:
    """The source that weighs most may be smaller, or has to be."""
    share, table = _judged(study, r).shares[0], study.file.mission.error_budget
    assert table is not None  # such a requirement has it
    if share.contribution.kind == "loop":
        noise = _OF_NOISE.get(share.name)
        return advise_change(r, noise) if noise else advise_change(r, "fine_pointing.rate", "raise")
    stated = table.sources.get(share.name)
    if stated is None:  # several that are correlated
        return ""
    key, size = size_key(share.name, stated.kind), stated.rate_rad_s if stated.kind == "drift" else stated.size_rad
    if not size or not share.allowed or not math.isfinite(share.allowed):
        return advise_change(r, key)
    return advise_at_most(r, key, size * share.allowed, "rad/s" if stated.kind == "drift" else "rad")


def _of_stroke(study: Study, r: Requirement) -> str:
    m, axis = study.file.mission, worst_axis(study)
    assert m.fine_pointing is not None  # such a requirement has it
    own = {
        "Body pointing": ("fine_pointing.body.error", m.fine_pointing.body.error_rad),
        "Point-ahead": ("fine_pointing.reference.point_ahead", m.fine_pointing.reference.point_ahead_rad),
    }
    line = max(axis.lines, key=lambda each: each.value)
    left = line.value + axis.margin_rad / axis.mirror_per_line_of_sight
    if line.name not in own or left <= 0.0:
        return advise_change(r, "mirror.travel", "raise")
    key, value = own[line.name]
    return advise_at_most(r, key, value * left / line.value, "rad")


def worst_axis(study: Study) -> StrokeBudget:
    """The axis of the fine-pointing loop, which there is, whose stroke has the least to spare."""
    assert study.fine_pointing is not None
    return min(study.fine_pointing.scene.own_stroke, key=lambda each: each.margin_rad)


def most_sensitive(swings: Sequence[link.Swing]) -> str:
    """The input that moves a margin most, the first of a tornado with a number, and by how much, or nothing."""
    known = [s for s in swings if math.isfinite(s.swing_db)]
    if not known:
        return ""
    top = known[0]  # they stand by their size, and equal ones as the mission has their keys
    step = (
        "ten times more or less" if top.key.endswith(_BY_TEN) else "±0.5 dB" if top.unit.startswith("dB") else "±10 %"
    )
    return f"; the margin moves most with {top.key}: {quantity(top.swing_db, 'dB')} for {step}"


def largest_loss(budget: link.LinkBudget) -> str:
    """The largest loss that a design can change, with its size."""
    losses = [line for line in budget.lines if line.unit == "dB" and line.name != FREE_SPACE_LOSS]
    line = min(losses, key=lambda each: each.value)
    return f"{line.name} {quantity(-line.value, 'dB')}"


def _power(study: Study, budget: link.LinkBudget) -> str:
    swings = next((t.swings for t in study.links.tornados if t.of == budget.name), ())
    return f"{largest_loss(budget)}{most_sensitive(swings)}"


def _stroke(study: Study, cause: str) -> str:
    axis = worst_axis(study)
    line = max(axis.lines, key=lambda each: each.value)
    return (
        f"{cause}: {quantity(line.value, 'rad')} of the {quantity(axis.total_rad, 'rad')} needed at the line of sight"
    )


def _residual(study: Study, cause: str) -> str:
    run = study.residual
    straight = next(
        r for r in study.runs if (r.mirror, r.controller, r.freq_hz) == (Variant.STRAIGHT, run.controller, run.freq_hz)
    )
    with_it, without = (quantity(study.left_rad(r), "rad") for r in (run, straight))
    return f"{cause}: {with_it} with hysteresis, {without} without"


def _communication(study: Study, cause: str) -> str:
    lost = study.achieved.loss_db(POINTING_LOSS)
    judged = study.fine_case is None
    return f"{cause}, pointing loss {quantity(lost, 'dB')}{most_sensitive(study.tornado.swings) if judged else ''}"


def _fine(study: Study, cause: str) -> str:
    fine = study.fine_pointing
    assert fine is not None  # such a requirement has one
    sizes = {part.name: part.rms_rad for part in fine.budget.parts}
    sizes |= {d.name: d.added_rad for d in fine.budget.differences}
    own, whole = sizes[cause], fine.budget.full_rad
    share = percent((own / whole) ** 2)
    sizes_of = f"{quantity(own, 'rad')} of {quantity(whole, 'rad')} rms with hysteresis"
    return f"{source_name(cause)}: {sizes_of}, {share} of the sum of squares"


def _outage(study: Study, cause: str) -> str:
    case = study.fine_case
    assert case is not None  # such a requirement has one
    lost = quantity(case.outage_loss_db, "dB")
    return f"{source_name(cause)}, pointing loss {lost} at the outage{most_sensitive(study.tornado.swings)}"


_CONTRIBUTORS: Mapping[Subject, Callable[[Study, str], str]] = {
    "cone": lambda study, cause: _cone(study),
    "beacon": lambda study, cause: _power(study, study.beacon),
    "answer": lambda study, cause: _power(study, study.answer),
    "residual": _residual,
    "stroke": _stroke,
    "communication": _communication,
    "fine pointing": _fine,
}
_OF_FINE = {**_CONTRIBUTORS, "communication": _outage}
