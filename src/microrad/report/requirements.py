"""Requirements of a study or of the links alone, however they are shown: a table, a paragraph, plain data."""

from collections.abc import Sequence
from typing import Any

from microrad.link.requirement import DERIVED, Requirement
from microrad.report import quantities
from microrad.report.quantities import apart
from microrad.report.tables import Table


def table(found: Sequence[Requirement]) -> Table:
    """Requirements for a terminal."""
    cells = [(r.name, *reversed(apart(r.actual, r.required, r.unit)), signed(r), r.mark) for r in found]
    return Table("", ("requirement", "required", "achieved", "to spare", ""), cells, (0,))


def paragraph(found: Sequence[Requirement]) -> str:
    """What holds and what does not, a clause for each requirement."""
    failed = [r for r in found if not r.met]
    parts = [f"{len(found) - len(failed)} of {len(found)} requirements are met."]
    if failed:
        parts.append(f"FAIL: {'; '.join(f'{r.name} {signed(r)}, by {r.because}' for r in failed)}.")
    for mark in ("PASS", DERIVED):
        held = [r for r in found if r.mark == mark]
        if held:
            parts.append(f"{mark[:1].upper() + mark[1:]}: {'; '.join(f'{r.name} {signed(r)}' for r in held)}.")
    return " ".join((*parts, *filter(None, [derived_words(found)])))


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

    def order(r: Requirement) -> tuple[bool, bool, float]:
        if r.unit == "dB":
            spare = 10.0 ** (r.margin / 10.0)
        elif r.unit == "%":
            spare = (100.0 - r.required) / max(100.0 - r.actual, 1e-12)
        else:
            small, large = (abs(each) or 1e-12 for each in (r.required, r.actual))
            spare = large / small if (r.margin >= 0.0) == (large > small) else small / large
        return r.met, r.mark == DERIVED, spare

    return min(found, key=order)


def signed(r: Requirement) -> str:
    """The margin with its sign."""
    return quantities.signed(r.margin, r.unit)


def data(r: Requirement) -> dict[str, Any]:
    """A requirement as plain data, in its own unit."""
    return {
        "name": r.name,
        "unit": r.unit,
        "required": r.required,
        "actual": r.actual,
        "margin": r.margin,
        "met": r.met,
        "mark": r.mark,
        "derived": list(r.derived),
        "limited_by": r.because,
    }


def warned(warnings: Sequence[str]) -> str:
    """The first warning in short, with how many there are; nothing without one."""
    if not warnings:
        return ""
    which = f"Warning 1 of {len(warnings)} (all by --verbose)" if len(warnings) > 1 else "Warning"
    return f"{which}: {warnings[0]}."
