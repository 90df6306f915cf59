"""One study: from a mission file to a verdict. The story, and the only place where the parts meet."""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from microrad import control, fine_pointing, link, mirror_summary, paper, pointing, simulate, tracking, verdict
from microrad.mission import Mission
from microrad.missionfile import MissionFile

Floats = NDArray[np.float64]
Progress = Callable[[int, int, str], None]


@dataclass(frozen=True, slots=True)
class MarginMap:
    """Fig. 2: margin in dB, shape (rates, errors), and the requirement solved in both directions, not read off it."""

    data_rate_bit_s: Floats
    pointing_error_rad: Floats
    margin_db: Floats
    largest_rate_bit_s: float
    largest_error_rad: float
    readings: tuple[link.SensitivityReading, ...]
    ideal: tuple[link.IdealReceiver, ...]


@dataclass(frozen=True, slots=True)
class Comparison:
    """The largest residual on the mission's comparison model, and the margin of the communication link at it."""

    residual: tracking.Run
    margin_db: float


@dataclass(frozen=True, slots=True)
class Study:
    """Everything that a report shows, computed. ``achieved`` is the communication budget at the simulated residual."""

    file: MissionFile
    open_loop: pointing.OpenLoopPointing
    beacon: link.LinkBudget
    answer: link.LinkBudget
    communication: link.LinkBudget
    achieved: link.LinkBudget
    margin_map: MarginMap
    summary: mirror_summary.Summary
    loops: tuple[simulate.HysteresisLoop, ...]
    margins: control.Margins
    runs: tuple[tracking.Run, ...]
    residual: tracking.Run
    comparison: Comparison | None
    scan: paper.Scan | None
    fine_pointing: fine_pointing.FinePointingStudy | None
    requirements: tuple[verdict.Requirement, ...]
    claims: tuple[verdict.Claim, ...]

    @property
    def closes(self) -> bool:
        """Whether each of the three links has a margin of at least 0 dB, communication at the simulated residual."""
        return min(self.beacon.margin_db, self.answer.margin_db, self.achieved.margin_db) >= 0.0


def run(file: MissionFile, on_progress: Progress = lambda done, total, what: None) -> Study:
    """The whole study of a mission: budgets, mirror, loops, and the link at the residual that the loop leaves.

    Raises ValueError with the reason when the loop is unstable or the mirror has no inverse.
    """
    m, sources = file.mission, file.sources
    on_progress(0, 3, "budgets")
    open_loop = pointing.open_loop_budget(m, sources)
    beacon, answer = link.beacon_budget(m, sources), link.answer_budget(m, sources)
    communication, fig2 = link.communication_budget(m, sources), margin_map(file)

    on_progress(1, 3, "mirror and tracking (the first run compiles for half a minute)")
    summary, loops = mirror_summary.summarise(m.mirror), tracking.hysteresis_loops(m)
    margins, runs = tracking.loop_margins(m), tracking.tracking_runs(m)
    residual = tracking.worst(m, runs)
    left_rad = tracking.residual_rad(m, residual.trace)
    simulated = f"simulated: {residual.trace.name}, {m.requirement.residual_statistic} ({m.conventions.residual})"
    achieved = link.communication_budget(m, sources, pointing_error_rad=left_rad, given_source=simulated)

    on_progress(2, 3, "claims of the paper")
    scan = paper.scan(m, on_progress) if paper.applies(m) else None
    fine = fine_pointing.run(file, on_progress) if m.fine_pointing is not None else None
    on_progress(3, 3, "verdict")
    evidence = verdict.Evidence(
        m, open_loop, beacon, communication, fig2.readings, fig2.ideal, loops, summary, runs, scan
    )
    return Study(
        file=file,
        open_loop=open_loop,
        beacon=beacon,
        answer=answer,
        communication=communication,
        achieved=achieved,
        margin_map=fig2,
        summary=summary,
        loops=loops,
        margins=margins,
        runs=runs,
        residual=residual,
        comparison=compare(file, runs),
        scan=scan,
        fine_pointing=fine,
        requirements=(
            *verdict.requirements(m, open_loop, beacon, answer, achieved, residual, runs),
            *([] if fine is None else [fine_requirement(m, fine)]),
        ),
        claims=verdict.against_paper(evidence),
    )


def fine_requirement(m: Mission, fine: fine_pointing.FinePointingStudy) -> verdict.Requirement:
    """The best controller's radial error on the mission's mirror, with what makes up most of it."""
    left = fine.best.simulated["given"]
    return verdict.fine_pointing_requirement(
        m, left.quantile_rad, fine.quantile, fine.best.design.name, fine.budget.dominant
    )


def compare(file: MissionFile, runs: tuple[tracking.Run, ...]) -> Comparison | None:
    """The link on the comparison model, when the mission has one."""
    m = file.mission
    if m.mirror.comparison is None:
        return None
    run = tracking.worst(m, runs, "comparison")
    return Comparison(run, float(link.margin_of_error(m, np.array([tracking.residual_rad(m, run.trace)]))[0]))


def largest_error(m: Mission, margin_db: float) -> float:
    """Largest pointing error (rad) for a margin at the mission's rate; nan when the link has not even that on axis."""
    try:
        return link.largest_pointing_error(m, margin_db, m.communication.data_rate_bit_s)
    except link.LinkError:
        return math.nan


def margin_map(file: MissionFile) -> MarginMap:
    """Margin over data rate and pointing error around the requirement, with the receivers that it implies."""
    m, q = file.mission, file.mission.requirement
    rates = m.communication.data_rate_bit_s * np.geomspace(1 / 30, 30, 181)
    errors = 3.0 * max(q.pointing_error_rad, m.communication.pointing_error_rad) * np.linspace(0.0, 1.0, 121)
    return MarginMap(
        rates,
        errors,
        link.margin_map(m, rates, errors),
        link.largest_data_rate(m, q.margin_db, q.pointing_error_rad),
        largest_error(m, q.margin_db),
        link.implied_sensitivity(m),
        link.ideal_receivers(m, file.sources),
    )
