"""One study: from a mission file to a verdict. The story, and the only place where the parts meet."""

import math
from dataclasses import dataclass, replace

import numpy as np

from microrad import link, mirror, orbit
from microrad.core import kept
from microrad.core.arrays import Floats
from microrad.core.progress import Progress
from microrad.core.threads import both
from microrad.link import pointing, requirement
from microrad.link import study as link_study
from microrad.link import under_jitter as link_performance
from microrad.link.tracking_light import tracking_light_w
from microrad.loop import control, fine_pointing, paper_cases, sine_run
from microrad.mirror import Variant
from microrad.mirror import summary as mirror_summary
from microrad.mission.file import LinkFile, MissionFile, with_contents
from microrad.mission.model import LinkMission, Mission
from microrad.orbit import constellation
from microrad.orbit import day as day_study
from microrad.study import alternatives, contact_run, paper, pointing_cost, verdict

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
    ``day`` is what the link delivers under the best of those residuals, ``contact`` one of its contacts in time, and
    ``plan`` that of a constellation; each is None where the mission lacks a table for it.
    """

    file: MissionFile
    links: link_study.LinkStudy
    achieved: link.LinkBudget
    margin_map: MarginMap
    summary: mirror_summary.Summary
    loops: tuple[sine_run.HysteresisLoop, ...]
    margins: control.Margins
    runs: tuple[paper_cases.Run, ...]
    residual: paper_cases.Run
    comparison: Comparison | None
    other_readings: tuple[alternatives.Reading, ...]
    scan: paper.Scan | None
    fine_pointing: fine_pointing.FinePointingStudy | None
    performance: pointing_cost.LinkPerformance
    tornado: link.Tornado
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
        return link.communication_budget(self.file.mission, self.file.sources)

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
        """Whether each of the three links has a margin of at least 0 dB, communication under the judged loop."""
        possible = self.achieved.possible if self.fine_case is None else self.fine_case.possible
        return self.beacon.closes and self.answer.closes and possible and self.margin_db >= -requirement.ROUNDING

    @property
    def met(self) -> bool:
        """Whether every requirement is met."""
        return all(r.met for r in self.requirements)

    @property
    def fine_case(self) -> link_performance.Performance | None:
        """The link under the best controller of the fine-pointing loop, or None in a mission without that loop."""
        return best_case(self.performance, self.fine_pointing)

    @property
    def margin_db(self) -> float:
        """Margin of communication under the loop that is judged: but for the outage, or at the paper's residual."""
        case = self.fine_case
        return self.achieved.margin_db if case is None else case.margin_db


def _present(budget: link.LinkBudget | None) -> link.LinkBudget:
    assert budget is not None  # a whole mission has all three
    return budget


def run(
    file: MissionFile, on_progress: Progress = lambda done, total, what: None, parts: kept.Kept = kept.NOTHING
) -> Study:
    """The whole study of a mission: budgets, mirror, loops, and the link at the residual that the loop leaves.

    ``parts`` are those of earlier runs that are kept: none by default.

    Raises ValueError with the reason when the loop is unstable, the mirror has no inverse or the receiver does not take
    the data rate.
    """
    file = with_contents(solve_rate(file))
    if any(each.content is None for each in file.contents):  # it may be there when it is read
        parts = kept.NOTHING
    m, sources = file.mission, file.sources
    mirrors = mirror.of(m)
    cases = paper_cases.of(m, mirrors)
    on_progress(0, 3, "budgets, acquisition, mirror and tracking")
    (summary, loops, margins, runs), (links, fig2) = both(
        lambda: (mirror_summary.summarise(m.mirror), *parts.part(paper_cases.results, cases)),
        lambda: (link_study.run(_links_of(file), parts), margin_map(file)),
    )
    residual = paper_cases.worst(runs, m.requirement.residual_statistic)
    left_rad = paper_cases.residual_rad(m, residual.trace)
    simulated = f"simulated: {residual.trace.name}, {m.requirement.residual_statistic} ({m.conventions.residual})"
    achieved = link.communication_budget(m, sources, pointing_error_rad=left_rad, given_source=simulated)
    as_read = alternatives.others(m, residual, parts)

    on_progress(1, 3, "claims of the paper")
    scan = parts.part(paper.scan, cases, on_progress=on_progress) if paper.applies(m) else None
    fine = None
    if m.fine_pointing is not None:
        scene = fine_pointing.scene(file, mirrors, tracking_light_w(file))
        fine = parts.part(fine_pointing.run, scene, on_progress=on_progress)
    on_progress(2, 3, "the day")
    found = pointing_cost.run(m, runs, fine)
    case = best_case(found, fine)
    by_paper = verdict.of_residual(m, mirrors, sources, achieved, residual, runs)
    requirements, papers_loop = judged(file, links, by_paper, fine, found)
    day, contact, plan = delivered(file, links, found, fine, residual, achieved, parts)

    on_progress(3, 3, "verdict")
    evidence = verdict.Evidence(m, loops, summary, runs, scan, day)
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
        comparison=compare(file, runs),
        other_readings=as_read,
        scan=scan,
        fine_pointing=fine,
        performance=found,
        tornado=tornado(file, left_rad if case is None else case.error_rad),
        day=day,
        contact=contact,
        plan=plan,
        requirements=requirements,
        papers_loop=papers_loop,
        claims=verdict.against_paper(evidence),
    )


def solve_rate(file: MissionFile) -> MissionFile:
    """The file with a data rate of "largest" replaced by what it stands for; raises `LinkError` without one."""
    solved = link_study.solve_rate(_links_of(file))
    mission = file.mission.model_copy(update={"communication": solved.mission.communication})
    return replace(file, mission=mission, sources=solved.sources)


def _links_of(file: MissionFile) -> LinkFile:
    return LinkFile(file.mission, file.path, file.text, file.sha256, file.sources, file.contents)


def judged(
    file: MissionFile,
    links: link_study.LinkStudy,
    by_paper: Requirements,
    fine: fine_pointing.FinePointingStudy | None,
    found: pointing_cost.LinkPerformance,
) -> tuple[Requirements, Requirements]:
    """What the verdict judges, and what the paper's loop is held against beside it where it is not that."""
    case, beams = best_case(found, fine), requirement.of_beams(links)
    if fine is None or case is None:
        return (*beams, *by_paper), ()
    return (*beams, *verdict.of_fine_pointing(file.mission, file.sources, fine, case)), by_paper


def best_case(
    found: pointing_cost.LinkPerformance, fine: fine_pointing.FinePointingStudy | None
) -> link_performance.Performance | None:
    """The link under the fine-pointing loop's best controller on the mission's mirror, or None without that loop."""
    return None if fine is None else found.case(pointing_cost.FINE, fine.best.design.name, Variant.GIVEN)


def tornado(file: MissionFile, error_rad: float) -> link.Tornado:
    """What moves the margin of the communication link at a pointing error that stays as it is."""

    def margin_db(m: LinkMission) -> float:
        return float(link.margin_of_error(m, np.array([error_rad]))[0])

    m = file.mission
    return link.Tornado("Communication", margin_db(m), link.swings(m, file.sources, link.LINK_TABLES, margin_db))


def delivered(
    file: MissionFile,
    links: link_study.LinkStudy,
    found: pointing_cost.LinkPerformance,
    fine: fine_pointing.FinePointingStudy | None,
    residual: paper_cases.Run,
    achieved: link.LinkBudget,
    parts: kept.Kept = kept.NOTHING,
) -> tuple[day_study.DayStudy | None, contact_run.ContactRun | None, constellation.ConstellationPlan | None]:
    """The day under the best controller of the fine-pointing loop, or under the worst of the sines without one.

    Raises ValueError for orbits that do not hold over the mission's span.
    """
    m = file.mission
    if m.orbit is None or m.operations is None:
        return None, None, None
    case = best_case(found, fine)
    if case is not None:
        loss = day_study.PointingLoss(case.outage_loss_db, case.outage, f"{case.controller}, {case.source}")
    else:
        loss = day_study.loss_at(m, achieved.margin_db, f"simulated: {residual.trace.name}")
    planned = m.constellation is not None and orbit.repeats(m.constellation, m)

    def in_time() -> tuple[day_study.DayStudy, contact_run.ContactRun | None]:
        day = parts.part(day_study.run, links, loss)
        return day, parts.part(contact_run.of_mission, m, day, links.finding, fine)

    (day, contact), plan = both(
        in_time, lambda: parts.part(constellation.run, _links_of(file), loss) if planned else None
    )
    return day, contact, plan


def compare(file: MissionFile, runs: tuple[paper_cases.Run, ...]) -> Comparison | None:
    """The link on the comparison model, when the mission has one."""
    m = file.mission
    if m.mirror.comparison is None:
        return None
    run = paper_cases.worst(runs, m.requirement.residual_statistic, Variant.COMPARISON)
    return Comparison(run, float(link.margin_of_error(m, np.array([paper_cases.residual_rad(m, run.trace)]))[0]))


def largest_error(m: Mission, margin_db: float) -> float:
    """Largest pointing error (rad) for a margin at the mission's rate; nan when the link has not even that on axis."""
    try:
        return link.largest_pointing_error(m, margin_db, m.communication.data_rate_bit_s)
    except link.LinkError:
        return math.nan


def margin_map(file: MissionFile) -> MarginMap:
    """Margin over data rate and pointing error around the requirement, with the receivers that it implies."""
    m, q = file.mission, file.mission.requirement
    built = link.receiver(m)
    highest = math.inf if built is None else built.highest_data_rate_bit_s
    rate = m.communication.data_rate_bit_s
    rates = rate * np.geomspace(1 / 30, min(30.0, highest / rate), 181)
    errors = 3.0 * max(q.pointing_error_rad, m.communication.pointing_error_rad) * np.linspace(0.0, 1.0, 121)
    return MarginMap(
        rates,
        errors,
        link.margin_map(m, rates, errors),
        link.convention_maps(m, rates, errors),
        link_study.largest_rate(m),
        largest_error(m, q.margin_db),
        link.implied_sensitivity(m),
        link.ideal_receivers(m, file.sources),
    )
