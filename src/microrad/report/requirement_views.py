"""The verdict by requirement: its margin and what contributes most to it, with the numbers of the budgets."""

import math
from collections.abc import Callable, Sequence
from typing import Any

from microrad import link
from microrad.link.budget import FREE_SPACE_LOSS, POINTING_LOSS
from microrad.performance import FINE, NO_HYSTERESIS
from microrad.readings import Reading
from microrad.report.fine_pointing_words import percent, source_name
from microrad.report.quantities import apart, quantity
from microrad.study import Study
from microrad.tracking import residual_rad
from microrad.verdict import Requirement, unknown

Row = dict[str, Any]
_BY_TEN = ("bit_error_ratio", "outage")  # inputs that a tornado moves by their order of magnitude


def rows(study: Study) -> list[Row]:
    """Each requirement as text: mark, required, achieved, margin, and its dominant contributor."""
    found = zip(study.requirements, contributors(study), strict=True)
    return [_row(r, *apart(r.required, r.actual, r.unit), text) for r, text in found]


def _row(r: Requirement, required: str, achieved: str, contributor: str) -> Row:
    texts = {"required": required, "achieved": achieved, "margin": signed(r), "contributor": contributor}
    return {"name": r.name, "mark": mark(r), **texts}


def readings(study: Study) -> list[Row]:
    """The numbers that rest on the residual by each other reading, as text; first as the mission has them."""
    m = study.file.mission
    left, margin = residual_rad(m, study.residual.trace), study.achieved.margin_db
    own = Reading("as it stands", "", "", left, margin)
    return [
        {
            "key": r.key,
            "given": r.given,
            "other": r.other,
            "residual": r.failure or quantity(r.residual_rad, "rad"),
            "margin": "" if r.failure else quantity(r.margin_db, "dB"),
            "closes": "" if r.failure else "yes" if r.closes else "no",
            "mark": "" if r.failure else "PASS" if r.meets(m) and not unknown(m) else "FAIL",
        }
        for r in (own, *study.other_readings)
    ]


def mark(r: Requirement) -> str:
    """PASS or FAIL."""
    return "PASS" if r.met else "FAIL"


def signed(r: Requirement) -> str:
    """The margin with its sign."""
    text = quantity(r.margin, r.unit)
    return f"+{text}" if r.margin >= 0.0 else text


def paragraph(study: Study) -> str:
    """What holds and what does not, a clause for each requirement."""
    failed, passed = ([r for r in study.requirements if r.met == met] for met in (False, True))
    count = f"{len(passed)} of {len(study.requirements)} requirements are met."
    parts = [count]
    if failed:
        parts.append(f"FAIL: {'; '.join(f'{r.name} {signed(r)}, by {r.because}' for r in failed)}.")
    if passed:
        parts.append(f"PASS: {'; '.join(f'{r.name} {signed(r)}' for r in passed)}.")
    return " ".join(parts)


def contributors(study: Study) -> list[str]:
    """The dominant contributor to each requirement, in the order of the study's requirements."""
    named = zip(_CONTRIBUTORS, study.requirements, strict=False)
    return [_capital(r.unknown or of(study, r.limited_by)) for of, r in named]


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]


def _cone(study: Study) -> str:
    p = study.open_loop
    share, line = max(zip(p.variance_shares, p.lines, strict=True), key=lambda pair: pair[0])
    return f"{line.name}: {percent(share)} of the squares, {quantity(line.value, 'rad')} half width"


def _tornado(study: Study, of: str) -> Sequence[link.Swing]:
    return next((t.swings for t in study.links.tornados if t.of == of), ())


def most_sensitive(swings: Sequence[link.Swing]) -> str:
    """The input that moves a margin most, and by how much, or nothing."""
    known = [s for s in swings if math.isfinite(s.swing_db)]
    if not known:
        return ""
    top = max(known, key=lambda s: s.swing_db)
    step = "a factor of ten" if top.key.endswith(_BY_TEN) else "0.5 dB" if top.unit.startswith("dB") else "10 %"
    return f"; the margin moves most with {top.key}: {quantity(top.swing_db, 'dB')} for {step} both ways"


def largest_loss(budget: link.LinkBudget) -> str:
    """The largest loss that a design can change, with its size."""
    losses = [line for line in budget.lines if line.unit == "dB" and line.name != FREE_SPACE_LOSS]
    line = min(losses, key=lambda each: each.value)
    return f"{line.name} {quantity(-line.value, 'dB')}"


def _power(study: Study, budget: link.LinkBudget) -> str:
    return f"{largest_loss(budget)}{most_sensitive(_tornado(study, budget.name))}"


def _residual(study: Study, cause: str) -> str:
    m, run = study.file.mission, study.residual
    straight = next(
        r for r in study.runs if (r.mirror, r.controller, r.freq_hz) == (NO_HYSTERESIS, run.controller, run.freq_hz)
    )
    with_it, without = (quantity(residual_rad(m, r.trace), "rad") for r in (run, straight))
    return f"{cause}: {with_it} with hysteresis, {without} without"


def _communication(study: Study, cause: str) -> str:
    lost = next(line.value for line in study.achieved.lines if line.name == POINTING_LOSS)
    return f"{cause}, pointing loss {quantity(-lost, 'dB')}{most_sensitive(_tornado(study, study.achieved.name))}"


def _fine(study: Study, cause: str) -> str:
    fine = study.fine_pointing
    assert fine is not None  # such a requirement has one
    sizes = {part.name: part.rms_rad for part in fine.budget.parts}
    sizes |= {d.name: d.added_rad for d in fine.budget.differences}
    own, whole = sizes[cause], fine.budget.full_rad
    share = percent((own / whole) ** 2)
    sizes_of = f"{quantity(own, 'rad')} of {quantity(whole, 'rad')} rms with hysteresis"
    return f"{source_name(cause)}: {sizes_of}, {share} of the squares"


def _outage(study: Study, cause: str) -> str:
    fine = study.fine_pointing
    assert fine is not None  # such a requirement has one
    case = study.performance.case(FINE, fine.best.design.name, "given")
    assert case is not None
    lost = quantity(case.outage_loss_db, "dB")
    most = most_sensitive(_tornado(study, study.achieved.name))
    return f"{source_name(cause)}, pointing loss {lost} at the outage{most}"


_CONTRIBUTORS: tuple[Callable[[Study, str], str], ...] = (
    lambda study, cause: _cone(study),
    lambda study, cause: _power(study, study.beacon),
    lambda study, cause: _power(study, study.answer),
    _residual,
    _communication,
    _fine,
    _outage,
)
