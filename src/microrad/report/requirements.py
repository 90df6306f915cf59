"""Requirements of a study or of the links alone: a table, sentences, plain data, and what to change to meet them."""

import math
from collections.abc import Sequence
from typing import Any

from microrad import link
from microrad.core.units import format_quantity
from microrad.link import study as link_study
from microrad.link.requirement import DERIVED, UNDER_FADES, Requirement
from microrad.link.study import LinkStudy
from microrad.mission.tables.link import Beam
from microrad.report.data import fields
from microrad.report.quantities import apart, signed
from microrad.report.tables import Cell, Table


def requirement_table(found: Sequence[Requirement], causes: Sequence[str] = (), name: str = "requirements") -> Table:
    """Requirements with what is achieved.

    Args:
        found: the requirements.
        causes: what contributes most to each, shown where there is room for it; none leaves the column out.
        name: of the list in the JSON that has them.
    """
    rows: list[list[str | Cell]] = [
        [r.name, *reversed(apart(r.actual, r.required, r.unit)), margin_text(r), Cell("", r.mark), *causes[k : k + 1]]
        for k, r in enumerate(found)
    ]
    headings, brief = ("requirement", "required", "achieved", "to spare", ""), (0, 1, 2, 3, 4)
    names = {place: [f"{name}.{r.name}.{what}" for r in found] for place, what in ((2, "actual"), (3, "margin"))}
    if not causes:
        return Table("", headings, rows, (0,), cards=True, names=names)
    return Table("", (*headings, "contributes most"), rows, (0, 5), cards=True, brief=brief, names=names)


def met_words(found: Sequence[Requirement]) -> str:
    """That every requirement is met, and how many of them prove nothing."""
    derived = sum(r.mark == DERIVED for r in found)
    by_choice = f", {derived} of {len(found)} by the choice of an input" if derived else ""
    return f"every requirement is met{by_choice}"


def derived_words(found: Sequence[Requirement]) -> str:
    """What the mark "derived" says of the requirements that have it, or nothing."""
    inputs = dict.fromkeys(each for r in found if r.mark == DERIVED for each in r.derived)
    return "" if not inputs else f"Derived, so that meeting it proves nothing: {'; '.join(inputs)}."


def nearest(found: Sequence[Requirement]) -> Requirement:
    """The requirement that is missed by most or met by least, as a ratio of powers, of angles or of shares missed.

    Missed ones come first, and behind all others those that are met by the choice of an input.
    """

    return min(found, key=nearness)


def nearness(r: Requirement) -> tuple[bool, bool, float]:
    """By what requirements are put in order: those that are missed first, by the most, and the derived ones last."""
    if r.unit == "dB":
        spare = 10.0 ** (r.margin / 10.0)
    elif r.unit == "%":
        spare = (100.0 - r.required) / max(100.0 - r.actual, 1e-12)
    else:
        small, large = (abs(each) or 1e-12 for each in (r.required, r.actual))
        spare = large / small if (r.margin >= 0.0) == (large > small) else small / large
    return r.met, r.mark == DERIVED, spare


def margin_text(r: Requirement) -> str:
    """The margin with its sign."""
    return signed(r.margin, r.unit)


def requirement_data(r: Requirement) -> dict[str, Any]:
    """A requirement as plain data, in its own unit."""
    found = fields(r, "name", "unit", "required", "actual", "margin", "met", "mark")
    return {**found, "derived": list(r.derived), "limited_by": r.because}


def first_warning(warnings: Sequence[str]) -> str:
    """The first warning in short, with how many there are; nothing without one."""
    if not warnings:
        return ""
    which = f"Warning 1 of {len(warnings)} (all by --verbose)" if len(warnings) > 1 else "Warning"
    return f"{which}: {warnings[0]}."


# -------------------------------------------------------------------------------------------------------------- advice
_MOST_DB = 10.0  # above the power that there is: more of it is no advice


def advice_for_links(study: LinkStudy, r: Requirement) -> str:
    """What to change for a requirement of the links, as the end of a sentence, or nothing.

    Args:
        study: the links.
        r: the requirement.
    """
    m = study.file.mission
    if r.unknown:
        return ""
    if r.subject == "cone":
        return advice_for_cone(study, r)
    if r.name == UNDER_FADES and r.margin == -math.inf:
        return "; no power meets it: change communication.fading.interleaver or communication.fading.code"
    if r.subject == "communication" and m.jitter is not None and -r.margin > _MOST_DB and max(m.jitter.rms_rad) > 0.0:
        return _of_jitter(study, r)
    return advice_for_power(getattr(m, r.subject), r, next(t for t in study.tornados if t.of.lower() == r.subject))


def advice_for_cone(study: LinkStudy, r: Requirement) -> str:
    """What to change for the beacon to cover its partner, or to hold the root sum square of the errors.

    Args:
        study: the links, with an open-loop pointing budget.
        r: the requirement.
    """
    p = study.open_loop
    assert p is not None  # such a requirement has one
    needed = p.confident_divergence_rad if r.unit == "%" else p.required_divergence_rad
    return advise_at_least(r, "beacon.divergence", needed, "rad")


def advice_for_power(beam: Beam, r: Requirement, tornado: link.Tornado) -> str:
    """What to change for a margin: the transmit power, or what moves it most where that would be far too much.

    Args:
        beam: the link's table.
        r: the requirement.
        tornado: what moves the link's margin.
    """
    if -r.margin <= _MOST_DB:
        enough_w = beam.transmit_power_w * float(10.0 ** (-r.margin / 10.0))
        return advise_at_least(r, f"{r.subject}.transmit_power", enough_w, "W")
    known = [s for s in tornado.swings if math.isfinite(s.swing_db) and not s.key.startswith("requirement.")]
    return advise_change(r, known[0].key) if known else ""


def _of_jitter(study: LinkStudy, r: Requirement) -> str:
    solved = link_study.solve_key(study.file, "jitter.rms").solved.intervals
    if not solved:
        return advise_change(r, "jitter.rms")
    return advise_at_most(r, "jitter.rms", solved[-1].high, "rad")


# -------------------------------------------------------------------------------------------------------------- clauses
def advise_change(r: Requirement, key: str, verb: str = "change") -> str:
    """That a key moves a requirement.

    Args:
        r: the requirement.
        key: dotted key of the mission.
        verb: what is done to it.
    """
    return f"; to {'move' if r.met else 'meet'} it, {verb} {key}"


def advise_at_least(r: Requirement, key: str, value: float, unit: str) -> str:
    """That a key meets a requirement from a value on, which is rounded so that it does.

    Args:
        r: the requirement.
        key: dotted key of the mission.
        value: from which on it is met, in SI units.
        unit: its SI unit.
    """
    shown = format_quantity(_rounded(value, 1.0), unit)
    return f"{advise_change(r, key)}, which may be {shown} at least" if r.met else _take(key, shown, "more")


def advise_at_most(r: Requirement, key: str, value: float, unit: str) -> str:
    """That a key meets a requirement up to a value, which is rounded so that it does.

    Args:
        r: the requirement.
        key: dotted key of the mission.
        value: up to which it is met, in SI units.
        unit: its SI unit.
    """
    shown = format_quantity(_rounded(value, -1.0), unit)
    return f"{advise_change(r, key)}, which may be {shown} at most" if r.met else _take(key, shown, "less")


def _take(key: str, shown: str, further: str) -> str:
    return f"; to meet it, take {key} = {shown} or {further}"


def _rounded(value: float, sign: float) -> float:
    """The value with three digits, the last one up for a sign of 1 and down for -1."""
    step = 10.0 ** (math.floor(math.log10(value)) - 2)
    return sign * math.ceil(sign * value / step - 1e-9) * step
