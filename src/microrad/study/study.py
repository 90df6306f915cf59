"""The whole study, from a mission file to a verdict: calls the other rooms one after the other."""

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from microrad import link, mirror, orbit
from microrad.core import kept
from microrad.core.arrays import Floats
from microrad.core.progress import Progress
from microrad.core.threads import beside, both
from microrad.link import pointing, requirement
from microrad.link import study as link_study
from microrad.link.error_budget import assembly as error_budget
from microrad.link.pointing.outage import Performance
from microrad.loop import control, controller_study, coupled_study, paper_cases
from microrad.loop.pointing_loop import ensemble
from microrad.loop.pointing_loop.linear import close
from microrad.mirror import Variant
from microrad.mirror import summary as mirror_summary
from microrad.mirror.hysteresis import HysteresisLoop
from microrad.mission.file import MissionFile, with_contents
from microrad.mission.model import Source
from microrad.orbit import constellation
from microrad.orbit import day as day_study
from microrad.study import alternatives, contact_run, paper, pointing_penalty, verdict

Requirements = tuple[requirement.Requirement, ...]


@dataclass(frozen=True, slots=True)
class MarginMap:
    """Fig. 2: margin in dB, shape (rates, errors), and the requirement solved in both directions, not read off it.

    ``by_reading`` are the maps under each reading of pointing loss and Strehl, which the paper leaves open.
    """

    data_rate_bit_s: Floats
    pointing_error_rad: Floats
    margin_db: Floats
    by_reading: dict[tuple[str, str], Floats]
    largest_rate_bit_s: float
    largest_error_rad: float
    readings: tuple[link.SensitivityReading, ...]
    ideal: tuple[link.IdealReceiver, ...]


@dataclass(frozen=True, slots=True)
class Comparison:
    """The largest residual on the mission's comparison model, and the margin of the communication link at it."""

    residual: paper_cases.Run
    margin_db: float


@dataclass(frozen=True, slots=True)
class Study:
    """Everything that a report shows, computed. ``achieved`` is the communication budget at the simulated residual.

    ``requirements`` judge one terminal: with the mission's own fine-pointing loop, where it has one. The paper's loop
    is then judged in ``papers_loop``, which is empty else. ``other_readings`` are its numbers by other readings of what
    the paper leaves open.
    ``links`` holds what follows from the links' tables alone, ``performance`` what the simulated residuals cost them.
    ``tornado`` is what moves the judged margin, at the error that its loop leaves.
    ``error_budget`` is the budget of pointing errors, under the best controller of the fine-pointing loop where what
    that leaves is in it; None for a mission without that table.
    ``day`` is what the link delivers under the best of those residuals, ``contact`` one of its contacts in time, and
    ``plan`` that of a constellation; each is None where the mission lacks a table for it.
    """

    file: MissionFile
    links: link_study.LinkStudy
    achieved: link.LinkBudget
    margin_map: MarginMap
    summary: mirror_summary.Summary
    loops: tuple[HysteresisLoop, ...]
    margins: control.LoopMargins
    runs: tuple[paper_cases.Run, ...]
    residual: paper_cases.Run
    comparison: Comparison | None
    other_readings: tuple[alternatives.Reading, ...]
    scan: paper.Scan | None
    fine_pointing: controller_study.FinePointingStudy | None
    performance: pointing_penalty.LinkPerformance
    tornado: link.Tornado
    error_budget: error_budget.PointingErrorBudget | None
    day: day_study.DayStudy | None
    contact: contact_run.ContactRun | None
    plan: constellation.ConstellationPlan | None
    requirements: Requirements
    papers_loop: Requirements
    claims: tuple[verdict.Claim, ...]

    @property
    def open_loop(self) -> pointing.OpenLoopPointing:
        """The open-loop pointing budget."""
        found = self.links.open_loop
        assert found is not None  # a whole mission states its errors
        return found

    @property
    def communication(self) -> link.LinkBudget:
        """The communication link as budgeted: under a table `[jitter]` but for the outage."""
        return self.links.communication

    @property
    def static(self) -> link.LinkBudget:
        """The communication link at its static pointing error, whatever jitter there is."""
        return link.communication_budget(self.links.data, self.file.sources)

    @property
    def beacon(self) -> link.LinkBudget:
        """The beacon's budget."""
        return _present(self.links.beacon)

    @property
    def answer(self) -> link.LinkBudget:
        """The answer's budget."""
        return _present(self.links.answer)

    @property
    def closes(self) -> bool:
        """Whether each of the three links closes, communication under the judged loop.

        A link closes with a margin of at least 0 dB, where its budget has no more light arrive than was sent.
        """
        possible = self.achieved.possible if self.fine_case is None else self.fine_case.possible
        return self.beacon.closes and self.answer.closes and possible and self.margin_db >= -requirement.ROUNDING

    @property
    def met(self) -> bool:
        """Whether every requirement is met."""
        return all(r.met for r in self.requirements)

    @property
    def fine_case(self) -> Performance | None:
        """The link under the best controller of the fine-pointing loop, or None in a mission without that loop."""
        return best_case(self.performance, self.fine_pointing)

    def left_rad(self, run: paper_cases.Run) -> float:
        """What a tracked sine leaves as the link sees it (rad), in the mission's statistic and convention."""
        m = self.file.mission
        return paper_cases.residual_rad(m.requirement, m.conventions, run.trace)

    @property
    def margin_db(self) -> float:
        """Margin of communication under the loop that is judged: but for the outage, or at the paper's residual."""
        case = self.fine_case
        return self.achieved.margin_db if case is None else case.margin_db


def _present(budget: link.LinkBudget | None) -> link.LinkBudget:
    assert budget is not None  # a whole mission has all three
    return budget


def run_study(
    file: MissionFile, on_progress: Progress = lambda done, total, what: None, parts: kept.Kept = kept.NOTHING
) -> Study:
    """The whole study of a mission: budgets, mirror, loops, and the link at the residual that the loop leaves.

    Args:
        file: The mission.
        on_progress: Told how many of the three steps are done, and which one begins.
        parts: The results of earlier runs that are kept; none by default.

    Raises:
        ValueError: When the loop is unstable, the mirror has no inverse or the receiver does not take the data rate;
            the message says why.

    Example:
        ```python
        import microrad

        study = microrad.run_study(microrad.load_mission("leo-geo.toml"))
        print(study.achieved.margin_db)
        for line in study.communication.lines:
            print(f"{line.name:22} {line.value:9.2f} {line.unit:4} {line.source}")
        ```
    """
    file = with_contents(link_study.solve_rate(file))
    if any(each.content is None for each in file.contents):  # it may be there when it is read
        parts = kept.NOTHING
    m, q, sources = file.mission, file.mission.requirement, file.sources
    asked = None if m.error_budget is None else error_budget.of_mission(m.error_budget, sources)
    mirrors = mirror.of(m)
    cases = paper_cases.of(m, mirrors)

    def scene() -> controller_study.AnyScene:
        return coupled_study.of_mission(file, mirrors, link.tracking_light_w(file), link.arrival_of(file))

    def linked() -> tuple[link_study.LinkStudy, MarginMap]:
        found = link_study.run_link_study(file, parts)
        return found, margin_map(found.data, sources)

    compiled = ensemble.compile_in_background(lambda: scene().loop) if m.fine_pointing else lambda: None
    on_progress(0, 3, "budgets, acquisition, mirror and tracking")
    with beside(linked) as of_links:
        summary = mirror_summary.summarise(m.mirror)
        loops, margins, runs = parts.part(paper_cases.simulate, cases)
        residual = paper_cases.worst(runs, q.residual_statistic)
        as_read = alternatives.other_readings(m, residual, parts)
        on_progress(1, 3, "claims of the paper")
        scan = parts.part(paper.scan, cases, on_progress=on_progress) if paper.applies(m.mirror) else None
        fine = None
        try:
            if m.fine_pointing is not None:
                compiled()
                fine = fine_pointing_loop(scene(), parts, on_progress)
        except ValueError:
            of_links()  # what is wrong with the links is said first
            raise
        links, fig2 = of_links()
    data = links.data
    left_rad = paper_cases.residual_rad(q, m.conventions, residual.trace)
    simulated = f"simulated: {residual.trace.name}, {q.residual_statistic} ({m.conventions.residual})"
    achieved = link.communication_budget(data, sources, pointing_error_rad=left_rad, given_source=simulated)
    compared = None
    if m.mirror.comparison is not None:
        other = paper_cases.worst(runs, q.residual_statistic, Variant.COMPARISON)
        at_rad = paper_cases.residual_rad(q, m.conventions, other.trace)
        compared = Comparison(other, float(link.margin_of_error(data, at_rad)))

    on_progress(2, 3, "the day")
    found = pointing_penalty.performance_of_loops(data, m.conventions.residual, runs, fine)
    case = best_case(found, fine)
    cause = verdict.residual_cause(mirrors, q.residual_statistic, residual, runs)
    by_paper = verdict.of_residual(q, mirrors, sources, achieved, left_rad, cause)
    requirements, papers_loop = judged(links, by_paper, fine, case)
    errors = None
    if asked is not None:
        errors = pointing_errors(asked, fine, parts)
        requirements += verdict.of_error_budget(errors, sources, fine if asked.with_loop else None)
    if case is not None:
        loss = day_study.PointingLoss(case.outage_loss_db, case.outage, f"{case.controller}, {case.source}")
    else:
        loss = day_study.loss_at(data, achieved.margin_db, f"simulated: {residual.trace.name}")
    day, contact, plan = delivered(links, loss, fine, parts)

    on_progress(3, 3, "verdict")
    evidence = verdict.Evidence(m.amplifier, cases, loops, summary, runs, scan, day)
    return Study(
        file=file,
        links=links,
        achieved=achieved,
        margin_map=fig2,
        summary=summary,
        loops=loops,
        margins=margins,
        runs=runs,
        residual=residual,
        comparison=compared,
        other_readings=as_read,
        scan=scan,
        fine_pointing=fine,
        performance=found,
        tornado=tornado(links, left_rad if case is None else case.error_rad),
        error_budget=errors,
        day=day,
        contact=contact,
        plan=plan,
        requirements=requirements,
        papers_loop=papers_loop,
        claims=verdict.against_paper(evidence),
    )


def fine_pointing_loop(
    scene: controller_study.AnyScene, parts: kept.Kept, on_progress: Progress
) -> controller_study.FinePointingStudy:
    """The fine-pointing loop of a mission under the controllers that are designed for it.

    Args:
        scene: The loop.
        parts: The results of earlier runs that are kept.
        on_progress: Called with what is done of the step at hand, of how much, and the step in words.
    """
    if isinstance(scene, coupled_study.CoupledScene):
        return parts.part(coupled_study.design_and_simulate, scene, on_progress=on_progress)
    return parts.part(controller_study.design_and_simulate, scene, on_progress=on_progress)


def pointing_errors(
    asked: error_budget.Stated, fine: controller_study.FinePointingStudy | None, parts: kept.Kept = kept.NOTHING
) -> error_budget.PointingErrorBudget:
    """The budget of pointing errors, with what the best controller of the fine-pointing loop leaves where it is asked.

    Args:
        asked: What the mission asks for.
        fine: The study of the fine-pointing loop, None where the mission has none.
        parts: The results of earlier runs that are kept.
    """
    closed = None if fine is None or not asked.with_loop else close(fine.scene.theory, fine.best.design.controller)
    return parts.part(error_budget.judge, asked, closed)


def judged(
    links: link_study.LinkStudy,
    by_paper: Requirements,
    fine: controller_study.FinePointingStudy | None,
    case: Performance | None,
) -> tuple[Requirements, Requirements]:
    """The requirements that the verdict judges, and those on the paper's loop where they only stand beside it.

    Args:
        links: The study of the mission's links.
        by_paper: The requirements as the paper's loop meets them.
        fine: The study of the fine-pointing loop, None where the mission has none.
        case: The link under the best controller of that loop, None without it.
    """
    beams = (*requirement.of_beams(links), *requirement.of_fading(links))
    if fine is None or case is None:
        return (*beams, *by_paper), ()
    return (*beams, *verdict.of_fine_pointing(links.data.requirement, links.file.sources, fine, case)), by_paper


def best_case(
    found: pointing_penalty.LinkPerformance, fine: controller_study.FinePointingStudy | None
) -> Performance | None:
    """The link under the fine-pointing loop's best controller on the mission's mirror, or None without that loop.

    Args:
        found: The link under every residual that was simulated.
        fine: The study of the fine-pointing loop, None where the mission has none.
    """
    return None if fine is None else found.case(pointing_penalty.FINE, fine.best.design.name, Variant.GIVEN)


def tornado(links: link_study.LinkStudy, error_rad: float) -> link.Tornado:
    """What moves the margin of the communication link at a pointing error that stays as it is.

    Args:
        links: The study of the mission's links.
        error_rad: Radial pointing error, in rad.
    """
    m, sources = links.file.mission, links.file.sources

    def margin_db(data: link.DataLink) -> float:
        return float(link.margin_of_error(data, error_rad))

    swings = link.swings(
        m, sources, link.LINK_TABLES, m.conventions.strehl, lambda moved: margin_db(link.of(moved)), link.beam_passes
    )
    return link.Tornado("Communication", margin_db(links.data), swings)


def delivered(
    links: link_study.LinkStudy,
    loss: day_study.PointingLoss,
    fine: controller_study.FinePointingStudy | None,
    parts: kept.Kept = kept.NOTHING,
) -> tuple[day_study.DayStudy | None, contact_run.ContactRun | None, constellation.ConstellationPlan | None]:
    """The day at a pointing loss, its contact in time under the best controller, and the plan of a constellation.

    Args:
        links: The links of the mission, with their acquisition.
        loss: What pointing costs the laser link.
        fine: The fine-pointing loop; None in a mission without one, which then has no contact in time.
        parts: The results of earlier runs that are kept.

    Raises:
        ValueError: If an orbit does not hold over the mission's span.
    """
    m, operations = links.file.mission, links.file.mission.operations
    if m.orbit is None or operations is None:
        return None, None, None
    planned = m.constellation is not None and orbit.repeats(m.constellation, m.orbit)

    def in_time() -> tuple[day_study.DayStudy, contact_run.ContactRun | None]:
        day = parts.part(day_study.run_day_study, links, loss)
        of = operations, m.acquisition, links.data, day, links.finding, fine
        return day, parts.part(contact_run.of_mission, *of)

    (day, contact), plan = both(
        in_time, lambda: parts.part(constellation.run_constellation, links.file, loss) if planned else None
    )
    return day, contact, plan


def margin_map(data: link.DataLink, sources: Mapping[str, Source]) -> MarginMap:
    """Margin over data rate and pointing error around the requirement, with the receivers that it implies.

    The largest pointing error is nan where the link has not even on axis the required margin.

    Args:
        data: The communication link.
        sources: Where each value of the mission comes from, by its dotted key.
    """
    q, rate = data.requirement, data.table.data_rate_bit_s
    highest = math.inf if data.receiver is None else data.receiver.highest_data_rate_bit_s
    rates = rate * np.geomspace(1 / 30, min(30.0, highest / rate), 181)
    errors = 3.0 * max(q.pointing_error_rad, data.table.pointing_error_rad) * np.linspace(0.0, 1.0, 121)
    try:
        largest_error = link.largest_pointing_error(data, q.margin_db, rate)
    except link.LinkError:
        largest_error = math.nan
    return MarginMap(
        rates,
        errors,
        link.margin_map(data, rates, errors),
        link.convention_maps(data, rates, errors),
        link_study.largest_rate(data),
        largest_error,
        link.implied_sensitivity(data),
        link.ideal_receivers(data, sources),
    )
