"""What the page shows of the links: pointing, budgets, light, performance, acquisition; each as rows of text."""

import math
from collections.abc import Sequence
from typing import Any

from microrad.core.units import format_quantity
from microrad.link.acquisition.partner_search import LONGEST_LOOK_S, Finding, Found, Scanned
from microrad.link.pointing import OpenLoopPointing
from microrad.link.pointing.outage import Performance, stated_outage
from microrad.link.requirement import met, of_links
from microrad.link.study import LinkStudy, Solution
from microrad.mirror import Variant
from microrad.report.data import fields
from microrad.report.links import words
from microrad.report.links.figures import link_figures
from microrad.report.page.templates import render
from microrad.report.plotting.figure import Figure
from microrad.report.quantities import minus, quantity
from microrad.report.requirements import requirements_paragraph
from microrad.study.pointing_penalty import FINE, Cost, LinkPerformance

Row = dict[str, Any]
EARLY = 0.9
"""Share of the acquisitions that end in lock by the time that the table states."""

RAREST_FADE_HZ = 1.0 / (365.25 * 86400.0)
"""Fades rarer than one in a year are not counted."""


def links_page(study: LinkStudy, solution: Solution | None = None) -> str:
    """The budgets as one page that loads nothing, with their figures and no drawing library: their numbers stand below.

    Args:
        study: the links, at their budgeted errors or under their jitter.
        solution: the values of a key that leave the required margin, if one was solved for.
    """
    figures = [figure.static for figure in link_figures(study)]
    budgets = [(budget, "") for budget in study.budgets]
    context = {
        "study": study,
        "mission": study.file.mission,
        "verdict": words.verdict(study),
        "met": met(study),
        "solved": "" if solution is None else words.solution_text(solution),
        "paragraph": requirements_paragraph(of_links(study)),
        "links": links_section(study, budgets=budgets, figures=figures, files=False),
        "inputs": list(study.file.sources.items()),
    }
    return render("links/budget.html", context)


def links_section(
    links: LinkStudy, *, budgets: Sequence[tuple[Any, str]], figures: Sequence[Figure], files: bool
) -> dict[str, Any]:
    """What the template needs of the links alone; ``files`` says whether the figures' data stand beside the page."""
    under = links.under_jitter
    cases = () if under is None else (under,)
    return {
        "pointing": None if links.open_loop is None else pointing_section(links.open_loop),
        "budgets": budgets,
        "warnings": links.warnings,
        "sentences": words.consequences(links),
        "readings": (),
        "ideal": (),
        "noise": links.receiver_noise,
        "light": _light(links),
        "performance_words": [words.under_jitter_sentence(each, links) for each in cases],
        **_performance(cases, stated_outage(links.data.requirement) if cases else 0.0),
        "acquisition": None if links.finding is None else acquisition_section(links.finding),
        "figures": figures,
        "files": files,
    }


def pointing_section(p: OpenLoopPointing) -> Row:
    """Lines of the pointing budget with what is left for each, and its totals by every rule."""
    allocated = None if p.reading is None else p.allocation(p.reading.half_angle_rad, "rss")
    rows = []
    for place, line in enumerate(p.lines):
        left = ""
        if allocated is not None:
            # the other lines alone may exceed the beacon's cone
            left = "nothing" if allocated[place].note else format_quantity(allocated[place].largest_rad, "rad", 3)
        rows.append({"line": line, "share": f"{100 * p.variance_shares[place]:.1f} %", "left": left})
    left_for = ""
    if p.reading is not None:
        half = format_quantity(p.reading.half_angle_rad, "rad", 3)
        left_for = (
            "the largest half width, all others as they are, with which the root sum square equals the beacon's half "
            f"angle ({half})."
        )
    return {
        "rows": rows,
        "left_for": left_for,
        "confidence": f"{100 * p.confidence:g} %",
        "totals": p.summations,
        "sentences": coverage(p),
    }


def coverage(p: OpenLoopPointing) -> list[str]:
    """What the beacon's cone covers, by each reading of its divergence."""
    if p.reading is None or p.counter_reading is None:
        return []
    own, other = p.reading, p.counter_reading
    needed = format_quantity(own.confident_divergence_rad, "rad", 3)
    return [
        f"Read as {own.convention}, the beacon's half angle is {format_quantity(own.half_angle_rad, 'rad', 3)}, "
        f"{'at least' if own.covers else 'less than'} the root sum square, which is one axis. Its partner is inside "
        f"with a probability of {own.coverage:.4f}, both axes and their biases counted; {100 * p.confidence:g} % would "
        f"take a divergence of {needed}. Read as {other.convention}, the cone is "
        f"{format_quantity(other.half_angle_rad, 'rad', 3)} and the probability {other.coverage:.4f}."
    ]


def _light(links: LinkStudy) -> tuple[Any, ...]:
    t = links.tracking
    return () if t is None or t.noise_equivalent_angle is None else (*t.noise_lines, t.noise_equivalent_angle)


# --------------------------------------------------------------------------------------------------------- performance
def performance_rows(cases: Sequence[Performance], best: str, costs: Sequence[Cost] = ()) -> list[Row]:
    """The link under each distribution of pointing errors, a row each; ``best`` names the controller to mark.

    ``costs`` says what hysteresis takes from some of them.
    """
    of = {(c.source, c.controller, c.mirror): cost_cells(c) for c in costs}
    none = ["", ""] if costs else []
    return [
        {
            **fields(c, "source", "controller", "mirror"),
            "best": bool(best) and c.controller == best and c.mirror == Variant.GIVEN,
            "cells": cells(c) + of.get((c.source, c.controller, c.mirror), none),
        }
        for c in cases
    ]


def cells(c: Performance) -> list[str]:
    """The numbers of one row."""
    return [
        f"{math.hypot(*c.jitter.bias_rad, *c.jitter.rms_rad) * 1e6:.2f}",
        f"{c.mean_loss_db:.2f}",
        f"{c.outage_loss_db:.2f}",
        words.without_code(c),
        minus(f"{c.margin_db:+.2f}"),
        share(c.outage),
        share(c.short),
        f"{c.best.half_angle_rad * 1e6:.1f}{'*' if c.best.at_limit else ''}",
        f"{c.best.current_excess_db:.2f}",
        "none" if math.isnan(c.data_rate_bit_s) else f"{c.data_rate_bit_s * 1e-6:.0f}",
    ]


def share(value: float) -> str:
    """A share of the time; nothing was seen of what is none."""
    return "none" if value == 0.0 else f"{value:.1e}" if value < 1e-3 else f"{float(f'{100 * value:.2g}'):g} %"


def performance_note(*, costs: bool) -> str:
    """How the columns are to be read."""
    how = (
        "Rms: radial, about zero. Penalty, the power that the errors cost: with a code the mean loss where its "
        "interleaver spans many fades, the loss at the outage where it spans none; without a code what brings the mean "
        "bit error ratio back to its target, in a Gaussian beam, unknown for a receiver that is given by its "
        "sensitivity alone. Outage: share of the time with a margin below 0 dB. Best half angle: of a Gaussian beam, "
        "at 1/e2, with the most power at the error of that column; a star: the present one, since a narrower one would "
        "take a larger aperture. Data rate: the largest with the required margin at that loss."
    )
    against = " What hysteresis costs: against the same controller and the same errors on a mirror without it."
    return how + against if costs else how


def performance_section(found: LinkPerformance, best: str, given: Performance | None) -> dict[str, Any]:
    """What the template needs of the link under the simulated residuals.

    ``best`` names the controller to mark, and ``given`` is the link under the jitter of a mission's own, if it has one.
    """
    shown = [*filter(None, [given]), *(c for c in found.cases if c.mirror != Variant.STRAIGHT)]
    section = _performance(shown, found.outage, best, found.costs)
    return {**section, "performance_words": [residuals_sentence(found)], "fades": fade_sentences(found.cases)}


def _performance(
    cases: Sequence[Performance], outage: float, best: str = "", costs: Sequence[Cost] = ()
) -> dict[str, Any]:
    return {
        "performance": performance_rows(cases, best, costs),
        "performance_note": performance_note(costs=bool(costs)),
        "outage": f"{100 * outage:g} %",
        "costs": costs,
        "fades": fade_sentences(cases),
    }


def residuals_sentence(found: LinkPerformance) -> str:
    """How the residuals enter the link."""
    half = format_quantity(found.half_angle_rad, "rad", 3)
    fine = any(c.source == FINE for c in found.cases)
    first, then = (" first", ", then the loop under vibration and noise") if fine else ("", "")
    return (
        "The communication link under every simulated residual, by its own distribution and not by one static number: "
        f"the loss that is exceeded for {100 * found.outage:g} % of the time, against a beam of {half} half angle at "
        f"1/e2. Clean sines{first} (one axis, as in the paper){then}."
    )


def cost_cells(c: Cost) -> list[str]:
    """What hysteresis takes from one controller, as text: dB of margin, Mbit/s."""
    rate = "" if math.isnan(c.data_rate_bit_s) else signed(-c.data_rate_bit_s * 1e-6, 0)
    return [signed(-c.margin_db, 2), rate]


def signed(value: float, decimals: int) -> str:
    """A number that has no sign when it is shown as zero, and a minus sign, not a hyphen, when it is negative."""
    return minus(f"{round(value, decimals) + 0.0:.{decimals}f}")


def fade_sentences(cases: Sequence[Performance]) -> list[str]:
    """Fades below the required margin, a sentence for each case whose spectrum is known, and what to doubt."""
    known = [c for c in cases if not math.isnan(c.fades_per_s)]
    if not known:
        return []
    if all(c.fades_per_s < RAREST_FADE_HZ for c in known):
        return ["Fades below the required margin: less than one a year, for Gaussian errors of these spectra."]
    said = "; ".join(
        f"{c.controller or c.source}: "
        + (
            f"{c.fades_per_s:.3g} a second of {format_quantity(c.fade_s, 's', 3)} each"
            if c.fades_per_s >= RAREST_FADE_HZ
            else "less than one a year"
        )
        for c in known
    )
    found = [f"Fades below the required margin, for Gaussian errors of that rms and spectrum: {said}."]
    return found + [f"{c.fade_warning[0].upper()}{c.fade_warning[1:]}." for c in known if c.fade_warning][:1]


# --------------------------------------------------------------------------------------------------------- acquisition
def acquisition_section(f: Finding) -> Row:
    """Each way to find the partner, with its stages and one run."""
    return {"sentences": acquisition_paragraphs(f), "ways": [way(w) for w in f.ways], "early": f"{100 * EARLY:g} %"}


def way(w: Found) -> Row:
    """One way as text: exact beside simulated; what never locks has no times."""
    o, none = w.outcome, "\u2013"
    late = o.locked.given_success().quantile(EARLY)
    return {
        "name": w.name,
        "cells": [
            f"{o.success_probability:.4f}" if w.possible else "never",
            f"{w.simulated_probability:.4f}",
            quantity(o.mean_time_s, "s") if w.possible else none,
            words.simulated_mean(w),
            quantity(late, "s") if w.possible else none,
        ],
        "stages": w.stages,
        "log": w.log,
    }


def acquisition_paragraphs(f: Finding) -> list[str]:
    """What makes up the probability, and how the scan is laid out."""
    c = f.chances
    found = [
        "Exact sums over all orders of failures beside a seeded simulation of the same process. The wide beacon covers "
        f"its partner with a probability of {c.beacon_coverage:.4f} (its power suffices out to "
        f"{format_quantity(f.beacon_radius_rad, 'rad', 3)} off axis), the answer lands with {c.answer_coverage:.4f} "
        f"and is seen with {c.answer_detection:.4f}, the narrow beam back lands with {c.return_coverage:.4f}. The "
        "random part of the pointing error is drawn anew at each attempt; biases stand at their bounds."
    ]
    if f.scanned is not None:
        found.append(scan_words(f.scanned, f.sigma_rad))
    return found


def scan_words(s: Scanned, sigma_rad: float) -> str:
    """How the scan is laid out, and what its light does to it."""
    covers = (
        f"The scan covers {format_quantity(s.radius_rad, 'rad', 3)} about the predicted direction, for an uncertainty "
        f"of {format_quantity(sigma_rad, 'rad', 3)} rms per axis with biases"
    )
    stated = f"the {quantity(s.stated_detection_s, 's')} that are stated"
    if not s.detects:
        return (
            f"{covers}. It detects nothing: at the edge of its beam the partner's sensor would need more than "
            f"{quantity(LONGEST_LOOK_S, 's')} in place of {stated}."
        )
    covers += f", in {quantity(s.duration_s, 's')} at most."
    if s.needed_detection_s <= s.stated_detection_s:
        return covers
    needed = quantity(s.needed_detection_s, "s")
    return f"{covers} At the edge of its beam the partner's sensor needs {needed} in place of {stated}; the scan waits."
