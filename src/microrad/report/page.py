"""The report as one self-contained page."""

import math
from collections.abc import Sequence
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined

from microrad import link
from microrad.mission import Source
from microrad.missionfile import assumptions, changed_from_shipped
from microrad.performance import FINE
from microrad.report import constellation_views, contact_run_words, day_views, fine_pointing, links, words
from microrad.report.figures import Figure
from microrad.report.quantities import quantity
from microrad.report.results import versions
from microrad.study import Study
from microrad.units import format_quantity


def pages() -> Environment:
    """The package's templates, with every text escaped and a missing one an error."""
    return Environment(
        loader=PackageLoader("microrad.report", "."), autoescape=True, undefined=StrictUndefined, trim_blocks=True
    )


def angle(value_rad: float) -> str:
    """An angle as it stands in the page's tables."""
    return format_quantity(value_rad, "rad")


def render(
    study: Study,
    figures: Sequence[Figure],
    fine_figures: Sequence[Figure] = (),
    link_figures: Sequence[Figure] = (),
    day_figures: Sequence[Figure] = (),
) -> str:
    """The page's HTML; every text of the mission is escaped, and nothing is loaded from anywhere.

    ``fine_figures`` go to the section on the fine-pointing loop, which a study without that loop does not have,
    ``link_figures`` to those on the links, ``day_figures`` to that on the day.
    """
    template = pages().get_template("page.html")
    m, fine = study.file.mission, study.fine_pointing
    context: dict[str, Any] = {
        "study": study,
        "mission": m,
        "headline": words.headline(study),
        "explanation": words.explanation(study),
        "warnings": words.warnings(study),
        "requirements": study.requirements,
        "links": _links(study, link_figures),
        "quantity": quantity,
        "angle": angle,
        "mirror_lines": [line for line in str(study.summary).splitlines() if not line.startswith("  warning")],
        "sound": all(r.met for r in study.requirements) and not words.beyond_identified(study, study.residual),
        "changed": changed_from_shipped(study.file),
        "margins": _margins(study),
        "assumptions": assumptions(study.file),
        "inputs": _inputs(study.file.sources),
        "figures": figures,
        "day": _day(study, day_figures),
        "fine": None if fine is None else fine_pointing.context(fine, m, fine_figures),
        "versions": versions(),
    }
    return template.render(context)


def _links(study: Study, figures: Sequence[Figure]) -> dict[str, Any]:
    budgets = (
        (study.communication, ", as budgeted"),
        (study.achieved, ", at the simulated residual"),
        (study.beacon, ""),
        (study.answer, ""),
    )
    best = "" if study.fine_pointing is None else study.fine_pointing.best.design.name
    context = links.context(study.links, budgets=budgets, figures=figures, files=True)
    performance = links.performance(study.performance, best, study.links.under_jitter)
    return {
        **context,
        **performance,
        "performance_words": [*performance["performance_words"], *_left_out(study)],
        "sentences": [*context["sentences"], *_loop_noise(study)],
        "readings": study.margin_map.readings,
        "ideal": study.margin_map.ideal,
    }


def _day(study: Study, figures: Sequence[Figure]) -> dict[str, Any] | None:
    """The day, one of its contacts in time, and the constellation; None for a mission without orbits."""
    day, run, plan = study.day, study.contact, study.plan
    if day is None:
        return None
    o, fine = day.mission.operations, study.fine_pointing
    shown = None
    if run is not None and fine is not None and o is not None and o.contact is not None:
        rate = day.mission.communication.data_rate_bit_s if o.rates_bit_s is None else None
        name = fine.best.design.name
        shown = {
            "sentences": contact_run_words.sentences(run, o.contact.number, name, rate),
            "window_headings": contact_run_words.window_headings(fine.quantile),
            "windows": contact_run_words.window_rows(run),
            "log": contact_run_words.log_rows(run),
        }
    context = day_views.context(day, figures, files=True, run=shown)
    if plan is not None:
        context["constellation"] = {
            "sentences": constellation_views.sentences(plan),
            "headings": constellation_views.COLUMNS,
            "rows": constellation_views.rows(plan)[: constellation_views.MOST_ROWS],
        }
    return context


def _left_out(study: Study) -> list[str]:
    """What a correction of the point-ahead leaves, which no simulated error holds."""
    ahead = study.file.mission.point_ahead
    if ahead is None or not ahead.corrected or not ahead.error_rad:
        return []
    lost = link.communication_beam(study.file.mission).fall
    at = study.performance.case(FINE, study.fine_pointing.best.design.name, "given") if study.fine_pointing else None
    cost = ""
    if at is not None:
        error = lost.error_rad(at.outage_loss_db)
        more = float(lost.loss_db(error + ahead.error_rad)) - at.outage_loss_db
        cost = f": at most {more:.2f} dB more for the best loop"
    return [f"What the correction of point-ahead leaves ({angle(ahead.error_rad)}) is not in these errors{cost}."]


def _loop_noise(study: Study) -> list[str]:
    """The noise that the fine-pointing loop is simulated with, beside what the answer's light would allow."""
    light = study.links.tracking
    if study.fine_pointing is None or light is None or light.noise_equivalent_angle is None:
        return []
    used = angle(study.fine_pointing.scene.loop.optical.noise_rad)
    allowed = format_quantity(light.noise_equivalent_angle.value, "rad", 3)
    return [
        f"The fine-pointing loop is simulated with {used} of noise in its optical sensor; that light allows {allowed}."
    ]


def _inputs(sources: Any) -> list[tuple[str, Source]]:
    """What was given, but for the hundreds of numbers of a correlation, which stand in the mirror file."""
    shown = (item for item in sources.items() if item[0] != "mirror.uncertainty.correlation")
    return [(key, source) for key, source in shown if source.kind != "assumption"]


def _margins(study: Study) -> list[tuple[str, str]]:
    s = study.margins
    gain = "none needed" if math.isinf(s.gain) else f"{20 * math.log10(s.gain):.1f} dB"
    return [
        ("gain margin", gain),
        ("phase margin", f"{math.degrees(s.phase_rad):.0f}°"),
        ("delay margin", format_quantity(s.delay_s, "s", 3)),
        ("modulus margin, min |1 + L|", f"{s.modulus:.3f}"),
        ("crossover", "none" if math.isnan(s.crossover_hz) else format_quantity(s.crossover_hz, "Hz", 3)),
    ]
