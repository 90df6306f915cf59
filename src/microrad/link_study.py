"""The links of a mission and what follows from their tables: budgets, pointing, tracking light, acquisition."""

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from microrad import kept, link, pointing
from microrad.budget import Line
from microrad.link_acquisition import Finding, Tracking, finding, tracking
from microrad.link_performance import Performance, margin_under_jitter_db, of_jitter
from microrad.mission import LinkMission
from microrad.missionfile import LinkFile
from microrad.units import format_quantity

Floats = NDArray[np.float64]

UNDER_JITTER = "Communication under jitter"
"""What the margin of the communication link but for the outage is called."""


@dataclass(frozen=True, slots=True)
class PointAheadEffect:
    """Point-ahead by its three faces: an angle of the beam, a range of the mirror, and a loss when left out.

    `beam_half_angles` counts the communication beam's half angles at 1/e2; `loss_db` is what leaving it out costs at
    the mission's pointing error, and `mirror_range_rad` what a mirror ahead of no telescope has to cover both ways.
    """

    angle_rad: float
    corrected: bool
    beam_half_angles: float
    loss_db: float
    mirror_range_rad: float


@dataclass(frozen=True, slots=True)
class LinkStudy:
    """Everything that follows from the tables of the links alone. The links that a mission lacks are None.

    ``receiver_noise`` are the noise terms of the communication receiver at the received power, where it is given by
    what it is made of. ``tornado`` is that of the communication budget, ``tornados`` those of the margin under jitter,
    of the beacon and of the answer, as far as there are such.
    """

    file: LinkFile
    open_loop: pointing.OpenLoopPointing
    communication: link.LinkBudget
    beacon: link.LinkBudget | None
    answer: link.LinkBudget | None
    receiver_noise: tuple[Line, ...]
    largest_rate_bit_s: float
    tornado: tuple[link.Swing, ...]
    tornados: tuple[link.Tornado, ...]
    under_jitter: Performance | None
    tracking: Tracking | None
    point_ahead: PointAheadEffect | None
    finding: Finding | None

    @property
    def budgets(self) -> tuple[link.LinkBudget, ...]:
        """The budgets that there are, communication first."""
        return tuple(b for b in (self.communication, self.beacon, self.answer) if b is not None)

    @property
    def closes(self) -> bool:
        """Whether each budget has a margin of at least 0 dB."""
        return all(budget.margin_db >= 0.0 for budget in self.budgets)

    @property
    def warnings(self) -> tuple[str, ...]:
        """What a reader of the budgets must not overlook."""
        return tuple(warning for budget in self.budgets for warning in budget.warnings)


def solve_rate(file: LinkFile) -> LinkFile:
    """The file with a data rate of "largest" replaced by the rate that it stands for.

    Raises `LinkError` when no rate has the required margin.
    """
    found = link.solved(file.mission)
    if not found:
        return file
    rate = found["communication.data_rate"]
    beam = file.mission.communication.model_copy(update={"data_rate_bit_s": rate})
    q, own = file.mission.requirement, file.sources["communication.data_rate"]
    at = f"{q.margin_db:g} dB at {format_quantity(q.pointing_error_rad, 'rad')}"
    solved = replace(own, value=format_quantity(rate, "bit/s"), comment=f"solved for: the largest with {at}")
    mission = file.mission.model_copy(update={"communication": beam})
    return replace(file, mission=mission, sources={**file.sources, "communication.data_rate": solved})


def run(file: LinkFile, parts: kept.Kept = kept.NOTHING) -> LinkStudy:
    """Budgets of every link of a mission and what follows from them.

    Raises ValueError with the reason when a receiver does not take the data rate, or a scan has no time to detect.
    """
    file = solve_rate(file)
    m, sources = file.mission, file.sources
    beacon = None if m.beacon is None else link.beacon_budget(m, sources)
    answer = None if m.answer is None else link.answer_budget(m, sources)
    open_loop = pointing.open_loop_budget(m, sources)
    light = tracking(file, answer)
    communication, receiver = link.communication_budget(m, sources), link.receiver(m)
    rate = m.communication.data_rate_bit_s
    noise = () if receiver is None else receiver.noise_lines(communication.received_power_w, rate)
    return LinkStudy(
        file=file,
        open_loop=open_loop,
        communication=communication,
        beacon=beacon,
        answer=answer,
        receiver_noise=noise,
        largest_rate_bit_s=largest_rate(m),
        tornado=link.tornado(m, sources),
        tornados=tornados(file, beacon, answer),
        under_jitter=of_jitter(m),
        tracking=light,
        point_ahead=point_ahead(m),
        finding=parts.part(finding, m, open_loop, beacon, answer, light),
    )


def tornados(
    file: LinkFile, beacon: link.LinkBudget | None, answer: link.LinkBudget | None
) -> tuple[link.Tornado, ...]:
    """What moves the margins that stand in no communication budget: under jitter, of the beacon, of the answer."""
    m, sources, found = file.mission, file.sources, []
    if m.jitter is not None:
        tables = ("jitter", "requirement", *link.LINK_TABLES)
        swings = link.swings(m, sources, tables, margin_under_jitter_db)
        found.append(link.Tornado(UNDER_JITTER, margin_under_jitter_db(m), swings))
    for budget in (beacon, answer):
        if budget is not None:
            swings = link.beam_tornado(m, sources, "beacon" if budget is beacon else "answer")
            found.append(link.Tornado(budget.name, budget.margin_db, swings))
    return tuple(found)


def largest_rate(m: LinkMission) -> float:
    """Data rate with the required margin at the required pointing error, or nan when there is none."""
    try:
        return link.largest_data_rate(m, m.requirement.margin_db, m.requirement.pointing_error_rad)
    except link.LinkError:
        return math.nan


def point_ahead(m: LinkMission) -> PointAheadEffect | None:
    """What the mission's point-ahead is to its beam and its mirror, or None where it is not given."""
    if m.point_ahead is None:
        return None
    angle = pointing.point_ahead_rad(m.point_ahead.transverse_velocity_m_s)
    fall, error = link.communication_beam(m).fall, m.communication.pointing_error_rad
    loss = float(fall.loss_db(error + angle) - fall.loss_db(error))
    return PointAheadEffect(angle, m.point_ahead.corrected, angle / fall.half_angle_rad, loss, 2.0 * angle)
