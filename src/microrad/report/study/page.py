"""The report as one self-contained page."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from microrad.core.machine import versions
from microrad.core.units import format_quantity
from microrad.link.budget.lines import POINT_AHEAD_LOSS, POINTING_LOSS
from microrad.link.requirement import time_kept
from microrad.loop.paper_cases import Run
from microrad.mirror import Variant
from microrad.orbit.day import DayStudy
from microrad.report.day import words as day_words
from microrad.report.day.constellation import constellation_view
from microrad.report.day.contact_run import contact_sentences, transitions_table, windows_table
from microrad.report.day.page import day_view
from microrad.report.error_budget.page import budget_view
from microrad.report.fine_pointing.page import fine_pointing_view
from microrad.report.fine_pointing.tails import tail_view
from microrad.report.foundation import foundation_view
from microrad.report.links.views import (
    budget_table,
    budgets_view,
    links_views,
    paired_tables,
    performance_view,
    residuals_sentence,
)
from microrad.report.marks import Marks
from microrad.report.page.templates import drawing, inputs_view, mission_page
from microrad.report.paper.page import paper_view
from microrad.report.plotting.figure import Figure
from microrad.report.quantities import given_angle, quantity, signed
from microrad.report.results.manifest import embedded, hash_of_page, with_manifest
from microrad.report.study import chain, contributors, words
from microrad.report.tables import Table
from microrad.report.view import Block, Drawing, Points, Soft, Verbatim, View, told
from microrad.study.pointing_penalty import FINE
from microrad.study.study import Study


@dataclass(frozen=True, slots=True)
class StudyFigures:
    """The figures of a page by the part that shows them; a part that a study does not have has none."""

    study: tuple[Figure, ...] = ()
    bench: tuple[Figure, ...] = ()
    fine: tuple[Figure, ...] = ()
    tails: tuple[Figure, ...] = ()
    links: tuple[Figure, ...] = ()
    errors: tuple[Figure, ...] = ()
    day: tuple[Figure, ...] = ()

    @property
    def every(self) -> tuple[Figure, ...]:
        """All of them, in the order of the files."""
        return (*self.study, *self.bench, *self.fine, *self.tails, *self.links, *self.errors, *self.day)


def study_page(study: Study, drawn: StudyFigures, manifest: Mapping[str, Any]) -> str:
    """The page's HTML; every text of the mission is escaped, and nothing is loaded from anywhere.

    Args:
        study: a run of a whole mission.
        drawn: its figures.
        manifest: is put into the page as JSON: what `reproduce` runs again.
    """
    views = study_views(study, drawn)
    text = mission_page(study.file, "study", [], [*views, _origin(manifest)], data="beside", manifest=True)
    return with_manifest(text, embedded({**manifest, "page_sha256": hash_of_page(text)}))


def study_views(study: Study, drawn: StudyFigures) -> tuple[View, ...]:
    """A whole study in the order of its page: the verdict, what to doubt, the chain part by part, the paper, inputs.

    Args:
        study: a run of a whole mission.
        drawn: its figures.
    """
    required, fine = study.file.mission.requirement.pointing_error_rad, study.fine_pointing
    found = told(
        verdict_view(study),
        words.warnings_view(study),
        _chain(study),
        View("Pointing and link budgets", _links(study, drawn.links), "budgets"),
        _mirror_and_loop(study),
        None if fine is None else fine_pointing_view(fine, required, drawn.fine),
        None if fine is None else tail_view(fine, required, drawn.tails),
        None
        if study.error_budget is None
        else budget_view(study.error_budget, drawn.errors, words.loop_in_budget(study)),
        _day(study, drawn.day),
        paper_view(study, (*drawn.study, *drawn.bench), words.papers_loop_view(study), _readings(study)),
        inputs_view(study.file.sources),
    )
    marks = Marks.of(study.file.sources)
    shown = [*marks.blocks(found), foundation_view(study.file.sources, marks.legend)]
    return tuple(block for block in (*shown, _not_in_study(study)) if isinstance(block, View))


def verdict_view(study: Study) -> View:
    """The verdict with its requirements, and what it rests on."""
    terms = View("Terms", [Points([f"{term}: {said}" for term, said in words.terms(study).items()])], folded=True)
    rests = Points([*words.limits(study), *words.explanation(study)])
    return View("Verdict", [words.verdict_box(study), "What the verdict rests on:", rests, terms], "verdict")


def _chain(study: Study) -> View:
    stroke = "" if study.fine_pointing is None else "; at the mirror, whether its stroke covers the worst case"
    caption = (
        "Each arrow hands a result on: from where the satellites are to what arrives. PASS and FAIL are those of the "
        f"requirements above{stroke}."
    )
    drawn = drawing("study/chain.html", "chain", chain.stages(study))
    return View("The chain", [Drawing("chain", "The chain with its numbers", caption, drawn)], "chain")


def _mirror_and_loop(study: Study) -> View:
    """The mirror, the margins of the paper's loop, and each of its runs."""
    lines = [line for line in str(study.summary).splitlines() if not line.startswith("  warning")]
    heading = "margin of the sampled loop, hysteresis replaced by its gain"
    counted = ("rate-clamped", "saturated", "slew-limited", "alternating")
    runs = Table(
        "",
        ("mirror", "controller", "frequency", "peak", "rms", *counted),
        [_run(run) for run in study.runs],
        (0, 1),
        folded=f"Each of {len(study.runs)} runs, with its counts",
        names=dict(enumerate(("runs.peak_rad", "runs.rms_rad"), 3)),
    )
    of = [f"margins.{name}" for name in ("gain_up_db", "phase_rad", "delay_s", "modulus", "crossover_hz")]
    margins = Table("", (heading, "value"), _margins(study), names={1: of})
    said = words.mirror_of_loop(study)
    return View("Mirror and loop", told(said, Verbatim("\n".join(lines)), margins, runs), "mirror")


def _run(run: Run) -> list[str]:
    trace, counts = run.trace, run.trace.counts
    errors = (f"{value * 1e6:.2f} µrad" for value in (trace.peak_rad, trace.rms_rad))
    numbers = counts.clamped + counts.inverse_clamped, counts.saturated, counts.slew_limited, counts.alternating
    return [run.mirror, run.controller, f"{run.freq_hz:g} Hz", *errors, *map(str, numbers)]


def _readings(study: Study) -> View:
    said = (
        "What the paper leaves open is read in one way here. Each line reads one key of the mission in another way, "
        "all else as it is; what concerns the loop is simulated anew."
    )
    return View("By other readings", [said, contributors.readings_table(study)], folded=True)


def _not_in_study(study: Study) -> View:
    fine = study.fine_pointing is not None
    left = "Turbulence" if fine else "Vibration, sensor noise and turbulence"
    sky = "weather over the stations" if study.day is None or study.day.sky is None else "weather over radio stations"
    day = "contact times" if study.day is None else f"light time in the times of contacts, drag, {sky}"
    sines = "" if fine else " The residual is that of one axis tracking clean sines."
    return View(
        "Not in this study",
        [f"{left}; {day}; the pointing loss that a receiver into a single mode has on its own side.{sines}"],
        "not-in-this-study",
    )


def _origin(manifest: Mapping[str, Any]) -> View:
    """The manifest's short entries."""
    files = [("mission file", manifest["mission"])]
    files += [("mirror file", manifest["mirror"])] if manifest["mirror"] else []
    rows = [(what, f"{each['file']}, SHA-256 {each['sha256']}") for what, each in files]
    rows += [("named file", f"{name}, SHA-256 {digest}") for name, digest in manifest["inputs_sha256"].items()]
    arithmetic = "; ".join(f"{name}: {text}" for name, text in manifest["machine"].items())
    rows += [("random numbers", manifest["randomness"]), ("machine", arithmetic)]
    rows.append(("figures, as data and drawn", f"{len(manifest['files_sha256'])} files with their hashes"))
    made = ", ".join(f"{name} {version}" for name, version in versions().items())
    return View(
        "Manifest",
        [
            "This page holds what made it, as JSON: the mission's text, the files that it names, versions, seeds, the "
            "numbers of the summary and a hash of each figure's file. microrad reproduce report.html runs it again and "
            "says whether the numbers agree.",
            Table("", ("what", "value"), rows, (0, 1)),
            Soft(f"Made with {made}. Hashes of every file, this page's too, are in manifest.json."),
        ],
        "origin",
    )


def _links(study: Study, figures: Sequence[Figure]) -> tuple[View, ...]:
    judged = study.fine_case is not None
    names = ("as budgeted", "at the residual of the paper's loop" if judged else "at the simulated residual")
    tables = [
        *paired_tables(study.communication, study.achieved, names),
        *map(budget_table, (study.beacon, study.answer)),
    ]
    warned = "What “!” marks in the tables stands under Warnings."
    budgets = budgets_view(
        study.links, tables, figures, [*_judged(study), *_loop_noise(study)], _implied(study), warned=warned
    )
    return links_views(study.links, figures, budgets=budgets, performance=cost_view(study))


def cost_view(study: Study) -> View:
    """The link under its own jitter, where it has one, and under each simulated error on a mirror with hysteresis."""
    best = "" if study.fine_pointing is None else study.fine_pointing.best.design.name
    found, under = study.performance, study.links.under_jitter
    cases = [*([] if under is None else [under]), *(c for c in found.cases if c.mirror != Variant.STRAIGHT)]
    said = [residuals_sentence(found), *_left_out(study)]
    return performance_view(cases, found.costs, found.outage, said, best)


def _implied(study: Study) -> View:
    """The receiver's sensitivity that the required margin implies, and what ideal receivers would leave."""
    found = study.margin_map
    implied = [(r.pointing_loss, r.strehl, f"{r.photons_per_bit:.0f}") for r in found.readings]
    ideal = [(r.name, f"{r.photons_per_bit:.2f}", f"{r.margin_db:.2f} dB", r.formula) for r in found.ideal]
    return View(
        "What the required margin implies for the receiver",
        (
            f"The required {study.file.mission.requirement.margin_db:g} dB at the required pointing error and the "
            "mission's data rate imply a receiver sensitivity, so a budget that takes its sensitivity from there is "
            "circular. By how pointing loss and Strehl are read:",
            Table("", ("pointing loss", "Strehl", "photons per bit implied"), implied, (0, 1)),
            "Margin with ideal receivers at a bit-error rate of 1e-9 instead, at the budgeted pointing error:",
            Table("", ("receiver", "photons per bit", "margin", "formula"), ideal, (0, 3)),
        ),
        folded=True,
        listed=False,
    )


def _day(study: Study, figures: Sequence[Figure]) -> View | None:
    """The day, one of its contacts in time, and the constellation; None for a mission without orbits."""
    day = study.day
    if day is None:
        return None
    plan = None if study.plan is None else constellation_view(study.plan)
    return day_view(day, day_words.sentences(day), figures, _contact(study, day), plan, warned=True)


def _contact(study: Study, day: DayStudy) -> View | None:
    run, fine, o = study.contact, study.fine_pointing, day.operations
    if run is None or fine is None or o is None or o.contact is None:
        return None
    rate = day.data.table.data_rate_bit_s if o.rates_bit_s is None else None
    said = contact_sentences(run, o.contact.number, fine.best.design.name, rate)
    blocks: list[Block] = [*said, windows_table(run, fine.quantile), transitions_table(run)]
    return View("One contact in time", blocks, folded=True)


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


def _judged(study: Study) -> list[str]:
    """How the margin of the verdict follows from the budget, where another loop than the paper's is judged."""
    case = study.fine_case
    if case is None:
        return []
    budgeted, kept = study.static, time_kept(study.file.mission.requirement)
    lost = quantity(budgeted.loss_db(POINTING_LOSS, POINT_AHEAD_LOSS), "dB")
    return [
        f"The verdict's margin of {signed(study.margin_db, 'dB')} is that of the budget with another pointing loss: "
        f"{quantity(case.outage_loss_db, 'dB')}, which {case.controller} does not exceed for {kept}, in place of "
        f"{lost}."
    ]


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
