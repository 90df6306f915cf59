"""What to change for a requirement of the links: a key of the mission, and the value that just meets it."""

import math

from microrad import link
from microrad.core.units import format_quantity
from microrad.link import study as link_study
from microrad.link.requirement import Requirement
from microrad.link.study import LinkStudy
from microrad.mission.tables.link import Beam

_MOST = 10.0  # times the power that there is: more of it is no advice


def of_links(study: LinkStudy, r: Requirement) -> str:
    """What to change for a requirement of the links, as the end of a sentence, or nothing."""
    m = study.file.mission
    if r.unknown:
        return ""
    if r.subject == "cone":
        return of_cone(study, r)
    if r.subject == "communication" and m.jitter is not None and _factor(r) > _MOST and max(m.jitter.rms_rad) > 0.0:
        return _of_jitter(study, r)
    return of_power(getattr(m, r.subject), r, next(t for t in study.tornados if t.of.lower() == r.subject))


def of_cone(study: LinkStudy, r: Requirement) -> str:
    """What to change for the beacon to cover its partner, or to hold the root sum square of the errors."""
    p = study.open_loop
    assert p is not None  # such a requirement has one
    needed = p.confident_divergence_rad if r.unit == "%" else p.required_divergence_rad
    return at_least(r, "beacon.divergence", needed, "rad")


def of_power(beam: Beam, r: Requirement, tornado: link.Tornado) -> str:
    """What to change for a margin: the transmit power, or what moves it most where that would be far too much."""
    factor = _factor(r)
    if factor <= _MOST:
        return at_least(r, f"{r.subject}.transmit_power", factor * beam.transmit_power_w, "W")
    known = [s for s in tornado.swings if math.isfinite(s.swing_db) and not s.key.startswith("requirement.")]
    return change(r, known[0].key) if known else ""


def _of_jitter(study: LinkStudy, r: Requirement) -> str:
    solved = link_study.solve_key(study.file, "jitter.rms").solved.intervals
    if not solved:
        return change(r, "jitter.rms")
    return at_most(r, "jitter.rms", solved[-1].high, "rad")


def _factor(r: Requirement) -> float:
    """How many times the power would just meet a margin."""
    return float(10.0 ** (-r.margin / 10.0))


# -------------------------------------------------------------------------------------------------------------- clauses
def change(r: Requirement, key: str, verb: str = "change") -> str:
    """That a key moves a requirement."""
    return f"; to {'move' if r.met else 'meet'} it, {verb} {key}"


def at_least(r: Requirement, key: str, value: float, unit: str) -> str:
    """That a key meets a requirement from a value on, which is rounded so that it does."""
    shown = format_quantity(_rounded(value, 1.0), unit)
    return f"{change(r, key)}, which may be {shown} at least" if r.met else _take(key, shown, "more")


def at_most(r: Requirement, key: str, value: float, unit: str) -> str:
    """That a key meets a requirement up to a value, which is rounded so that it does."""
    shown = format_quantity(_rounded(value, -1.0), unit)
    return f"{change(r, key)}, which may be {shown} at most" if r.met else _take(key, shown, "less")


def _take(key: str, shown: str, further: str) -> str:
    return f"; to meet it, take {key} = {shown} or {further}"


def _rounded(value: float, sign: float) -> float:
    """The value with three digits, the last one up for a sign of 1 and down for -1."""
    step = 10.0 ** (math.floor(math.log10(value)) - 2)
    return sign * math.ceil(sign * value / step - 1e-9) * step
