"""The report as one self-contained page."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from microrad.core.machine import versions
from microrad.core.units import format_quantity
from microrad.mirror import Variant
from microrad.mission.file import assumptions, changed_from_shipped
from microrad.mission.model import Source
from microrad.report.day.constellation import plan_sentences, satellites_table
from microrad.report.day.contact_run import contact_sentences, transitions_table, windows_table
from microrad.report.day.page import day_section
from microrad.report.fine_pointing.page import fine_pointing_section
from microrad.report.fine_pointing.tails import tail_section
from microrad.report.links.page import links_section, performance_section
from microrad.report.page.templates import render
from microrad.report.paper.page import paper_section
from microrad.report.plotting.figure import Figure
from microrad.report.quantities import given_angle
from microrad.report.requirements import requirements_paragraph
from microrad.report.results.manifest import embedded, hash_of_page, with_manifest
from microrad.report.study import chain, contributors, words
from microrad.study.pointing_penalty import FINE
from microrad.study.study import Study

PARTS = (
    ("verdict", "Verdict"),
    ("chain", "The chain"),
    ("budgets", "Budgets and what the link delivers"),
    ("paper", "The paper's figures and tables"),
    ("error-budget", "Mirror, loop and error budget"),
    ("tails", "Monte Carlo tails"),
    ("assumptions", "Assumptions and inputs"),
    ("warnings", "Warnings"),
    ("origin", "Manifest"),
)
"""The page's parts in their order, by the name of their anchor."""


@dataclass(frozen=True, slots=True)
class StudyFigures:
    """The figures of a page by the part that shows them; a part that a study does not have has none."""

    study: tuple[Figure, ...] = ()
    bench: tuple[Figure, ...] = ()
    fine: tuple[Figure, ...] = ()
    tails: tuple[Figure, ...] = ()
    links: tuple[Figure, ...] = ()
    day: tuple[Figure, ...] = ()

    @property
    def every(self) -> tuple[Figure, ...]:
        """All of them, in the order of the files."""
        return (*self.study, *self.bench, *self.fine, *self.tails, *self.links, *self.day)


def study_page(study: Study, drawn: StudyFigures, manifest: Mapping[str, Any]) -> str:
    """The page's HTML; every text of the mission is escaped, and nothing is loaded from anywhere.

    ``manifest`` is put into the page as JSON: what `reproduce` runs again.
    """
    m, fine = study.file.mission, study.fine_pointing
    required = m.requirement.pointing_error_rad
    titles = [(id, title) for id, title in PARTS if fine is not None or id != "tails"]
    boxes = chain.stages(study)
    context: dict[str, Any] = {
        "study": study,
        "mission": m,
        "top": 3,  # level of the headings inside a part
        "parts": titles,
        "titles": dict(titles),
        "numbers": {id: place for place, (id, _) in enumerate(titles, start=1)},
        "headline": words.headline(study),
        "paragraph": requirements_paragraph(study.requirements),
        "explanation": words.explanation(study),
        "warnings": words.warnings(study),
        "requirements": contributors.rows(study),
        "papers_loop": contributors.papers_rows(study),
        "papers_words": words.papers_loop(study),
        "other_readings": contributors.readings(study),
        "chain_wide": chain.layout(boxes, 4, 960.0, 26.0),
        "chain_narrow": chain.layout(boxes, 1, 340.0, 24.0),
        "chain_words": chain.alternative(boxes),
        "paper": paper_section(study, (*drawn.study, *drawn.bench)),
        "links": _links(study, drawn.links),
        "mirror_lines": [line for line in str(study.summary).splitlines() if not line.startswith("  warning")],
        "sound": study.met and (study.fine_case is not None or not words.beyond_identified(study, study.residual)),
        "changed": changed_from_shipped(study.file.sources),
        "margins": _margins(study),
        "assumptions": assumptions(study.file.sources),
        "inputs": _inputs(study.file.sources),
        "day": _day(study, drawn.day),
        "fine": None if fine is None else fine_pointing_section(fine, required, drawn.fine),
        "tails": None if fine is None else tail_section(fine, required, drawn.tails),
        "versions": versions(),
        "origin": _origin(manifest),
    }
    text = render("study/study.html", context)
    return with_manifest(text, embedded({**manifest, "page_sha256": hash_of_page(text)}))


def _origin(manifest: Mapping[str, Any]) -> list[tuple[str, str]]:
    """The manifest's short entries, for the page."""
    files = [("mission file", manifest["mission"])]
    files += [("mirror file", manifest["mirror"])] if manifest["mirror"] else []
    rows = [(what, f"{each['file']}, SHA-256 {each['sha256']}") for what, each in files]
    rows += [("named file", f"{name}, SHA-256 {digest}") for name, digest in manifest["inputs_sha256"].items()]
    arithmetic = "; ".join(f"{name}: {text}" for name, text in manifest["machine"].items())
    rows += [("random numbers", manifest["randomness"]), ("machine", arithmetic)]
    return [*rows, ("figures, as data and drawn", f"{len(manifest['files_sha256'])} files with their hashes")]


def _links(study: Study, figures: Sequence[Figure]) -> dict[str, Any]:
    budgets = (
        (study.communication, ", as budgeted"),
        (study.achieved, ", at the simulated residual"),
        (study.beacon, ""),
        (study.answer, ""),
    )
    best = "" if study.fine_pointing is None else study.fine_pointing.best.design.name
    context = links_section(study.links, budgets=budgets, figures=figures, files=True)
    performance = performance_section(study.performance, best, study.links.under_jitter)
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
    o, fine = day.operations, study.fine_pointing
    shown = None
    if run is not None and fine is not None and o is not None and o.contact is not None:
        rate = day.data.table.data_rate_bit_s if o.rates_bit_s is None else None
        name = fine.best.design.name
        shown = {
            "sentences": contact_sentences(run, o.contact.number, name, rate),
            "windows": windows_table(run, fine.quantile),
            "log": transitions_table(run),
        }
    context = {**day_section(day, figures, files=True), "run": shown}
    if plan is not None:
        context["constellation"] = {"sentences": plan_sentences(plan), "table": satellites_table(plan)}
    return context


def _left_out(study: Study) -> list[str]:
    """What a correction of the point-ahead leaves, which no simulated error holds."""
    ahead = study.file.mission.point_ahead
    if ahead is None or not ahead.corrected or not ahead.error_rad:
        return []
    lost = study.links.data.beam.fall
    cost, fine = "", study.fine_pointing
    if fine is not None and (at := study.performance.case(FINE, fine.best.design.name, Variant.GIVEN)) is not None:
        error = lost.error_rad(at.outage_loss_db)
        more = float(lost.loss_db(error + ahead.error_rad)) - at.outage_loss_db
        cost = f": at most {more:.2f} dB more for the best loop"
    return [f"What the correction of point-ahead leaves ({given_angle(ahead.error_rad)}) is not in these errors{cost}."]


def _loop_noise(study: Study) -> list[str]:
    """The noise that the fine-pointing loop is simulated with, beside what the answer's light would allow."""
    light = study.links.tracking
    if study.fine_pointing is None or light is None or light.noise_equivalent_angle is None:
        return []
    used = given_angle(study.fine_pointing.scene.loop.optical.noise_rad)
    allowed = format_quantity(light.noise_equivalent_angle.value, "rad", 3)
    return [
        f"The fine-pointing loop is simulated with {used} of noise in its optical sensor; that light allows {allowed}."
    ]


def _inputs(sources: Any) -> list[tuple[str, Source]]:
    """What was given, but for the hundreds of numbers of a correlation, which stand in the mirror file."""
    shown = (item for item in sources.items() if item[0] != "mirror.uncertainty.correlation")
    return [(key, source) for key, source in shown if source.kind not in ("assumption", "derived")]


def _margins(study: Study) -> list[tuple[str, str]]:
    s = study.margins
    gain = "none needed" if math.isinf(s.gain_up) else f"{20 * math.log10(s.gain_up):.1f} dB"
    return [
        ("gain margin", gain),
        ("phase margin", f"{math.degrees(s.phase_rad):.0f}°"),
        ("delay margin", format_quantity(s.delay_s, "s", 3)),
        ("modulus margin, min |1 + L|", f"{s.modulus:.3f}"),
        ("crossover", "none" if math.isnan(s.crossover_hz) else format_quantity(s.crossover_hz, "Hz", 3)),
    ]
