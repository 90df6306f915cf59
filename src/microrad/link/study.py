"""The links of a mission and what follows from their tables: budgets, pointing, tracking light, acquisition."""

import difflib
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from microrad import link
from microrad.core import kept
from microrad.core.budget import Line
from microrad.core.units import format_quantity
from microrad.link import pointing, variation
from microrad.link.acquisition.partner_search import Finding, Sent, Tracking, answer_on_sensor, find_partner
from microrad.link.budget import assembly
from microrad.link.fade_series.coded import CodedFading
from microrad.link.fade_series.of_mission import fading_of
from microrad.link.ground import GroundLink, ground_link
from microrad.link.pointing.outage import (
    Performance,
    error_rad,
    margin_db,
    performance_under_jitter,
    required_error_rad,
    stated_outage,
)
from microrad.mission.file import LinkFile
from microrad.mission.model import LinkMission, Source, source_text

_File = TypeVar("_File", bound=LinkFile)

STATIC_MARGIN = "Static margin"
"""What the margin at the static pointing error is called where the margin is the one under a jitter."""

_OF_APERTURE = np.geomspace(0.1, 1.5, 28)
"""Radii of the beam, over that of its aperture, of which the best is looked for: a tenth from one to the next."""


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
class BeamRadius:
    """The radius of the data's beam with the largest margin in its aperture, and how much more margin that is (dB)."""

    best_m: float
    gained_db: float


@dataclass(frozen=True, slots=True)
class LinkStudy:
    """Everything that follows from the tables of the links alone. The links that a mission lacks are None.

    The communication budget is made at the error of `outage.error_rad`: under a jitter its margin is the one
    that is kept but for the outage, and the margin at the static pointing error stands below it. ``receiver_noise`` are
    the noise terms of the communication receiver at the received power, where it is given by what it is made of.
    ``data`` is the communication link assembled. ``tornados`` has one of each budget, in the same order.
    ``beam_radius`` is None unless the mission has one. ``fading`` is the link under a series of received power, at its
    static margin. ``ground`` is what there is to say of links to a station.
    """

    file: LinkFile
    data: link.DataLink
    open_loop: pointing.OpenLoopPointing | None
    communication: link.LinkBudget
    beacon: link.LinkBudget | None
    answer: link.LinkBudget | None
    receiver_noise: tuple[Line, ...]
    largest_rate_bit_s: float
    tornados: tuple[link.Tornado, ...]
    under_jitter: Performance | None
    tracking: Tracking | None
    point_ahead: PointAheadEffect | None
    beam_radius: BeamRadius | None
    finding: Finding | None
    fading: CodedFading | None = None
    ground: GroundLink | None = None

    @property
    def budgets(self) -> tuple[link.LinkBudget, ...]:
        """The budgets that there are, communication first."""
        return tuple(b for b in (self.communication, self.beacon, self.answer) if b is not None)

    @property
    def closes(self) -> bool:
        """Whether each budget closes: with a margin of at least 0 dB, and no more light than was sent."""
        return all(budget.closes for budget in self.budgets)

    @property
    def warnings(self) -> tuple[str, ...]:
        """What a reader of the budgets must not overlook."""
        return tuple(warning for budget in self.budgets for warning in budget.warnings)


def solve_rate(file: _File) -> _File:
    """The file with a data rate of "largest" replaced by the rate that it stands for.

    Raises LinkError when no rate has the required margin.
    """
    m = file.mission
    if not math.isnan(m.communication.data_rate_bit_s):
        return file
    data, q, own = link.of(m), m.requirement, file.sources["communication.data_rate"]
    error = required_error_rad(data)
    rate = link.largest_data_rate(data, q.margin_db, error)
    beam = m.communication.model_copy(update={"data_rate_bit_s": rate})
    at = f"{q.margin_db:g} dB at {format_quantity(error, 'rad')}"
    solved = replace(own, value=format_quantity(rate, "bit/s"), comment=f"solved for: the largest with {at}", was="")
    mission = m.model_copy(update={"communication": beam})
    return replace(file, mission=mission, sources={**file.sources, "communication.data_rate": solved})


@dataclass(frozen=True, slots=True)
class Solution:
    """The values of one key that leave what is required of a margin, in SI units, and the file with one of them.

    ``file`` has ``value``: the least that leaves the margin, or the most where as little as was looked for leaves it.
    Where none does, it is the given file with its own value.
    """

    key: str
    unit: str
    of: str
    required_db: float
    solved: variation.Solved
    value: float
    file: LinkFile


def solve_key(file: LinkFile, key: str) -> Solution:
    """The values of one key of the links' tables that leave the required margin.

    The margin is that of communication, but for the share of time of the outage. A key of the beacon's table is looked
    for at 0 dB of the beacon, one of the answer's at 0 dB of the answer.

    Args:
        file: The mission's file on its links.
        key: The dotted key, of an item in a list with its place from 1 behind it.

    Raises:
        ValueError: For a key that these tables do not have, and for one that is 0.
    """
    file = solve_rate(file)
    m, sources = file.mission, file.sources
    tables = ("jitter", *link.LINK_TABLES, *(name for name in ("beacon", "answer") if getattr(m, name) is not None))
    every = [each for table in tables for each in variation.inputs(m, table)]
    found = tuple(each for each in every if key in (each.key, each.shown))
    if not found:
        raise ValueError(_no_such_key(key, dict.fromkeys(each.key for each in every)))
    of, unit = found[0].table, variation.unit_of(found[0], m.conventions.strehl)
    if of in ("beacon", "answer"):
        required, margin, possible = 0.0, variation.beam_margin(of, sources), variation.divergence_possible(of)
    else:
        of, required, margin, possible = "communication", m.requirement.margin_db, _margin_db, link.beam_passes
    solved = variation.solve(m, found, unit, margin, required, possible)
    if not solved.intervals:
        return Solution(key, unit, of, required, solved, max((each.value for each in found), key=abs), file)
    first, last = solved.intervals[0], solved.intervals[-1]
    value = last.high if first.low_open else first.low
    mission = variation.moved(m, found, value)
    assert mission is not None  # it leaves the margin
    was = sources.get(found[0].key)
    shown = format_quantity(value, unit) if unit else f"{value:.4g}"
    comment = f"solved for: {required:g} dB of {of}"
    given = replace(was, value=shown, comment=comment, was="") if was else Source(0, comment, shown)
    changed = replace(file, mission=mission, sources={**sources, found[0].key: given})
    return Solution(key, unit, of, required, solved, value, changed)


def _no_such_key(key: str, keys: Iterable[str]) -> str:
    last = key[:60].rpartition(".")[2]
    near = [each for each in keys if each.rpartition(".")[2] == last] or difflib.get_close_matches(key[:60], keys, n=3)
    hint = f"did you mean {' or '.join(near)}?" if near else f"there are {', '.join(keys)}"
    return f'no table of the links has a quantity "{key[:60]}"; {hint}'


def run_link_study(file: LinkFile, parts: kept.Kept = kept.NOTHING) -> LinkStudy:
    """Budgets of every link of a mission and what follows from them.

    Args:
        file: The mission's file on its links.
        parts: Keeps the acquisition from an earlier run of the same inputs; keeps nothing by default.

    Raises:
        ValueError: When a receiver does not take the data rate, or a scan has no time to detect; the message says why.
    """
    file = solve_rate(file)
    m, sources, shared = file.mission, file.sources, link.Shared.of(file.mission)
    beacon, answer = (
        None if table is None else Sent(table, link.beam_budget(name, shared, table, sources))
        for name, table in (("beacon", m.beacon), ("answer", m.answer))
    )
    open_loop = None if m.pointing is None else pointing.open_loop_budget(m.pointing, shared, m.beacon, sources)
    light = answer_on_sensor(m.acquisition, m.terminals.leo_aperture_m, answer, sources)
    data = link.of(m)
    communication, rate = communication_budget(data, sources), m.communication.data_rate_bit_s
    noise = () if data.receiver is None else data.receiver.noise_lines(communication.received_power_w, rate)
    found = None
    if m.acquisition is not None and beacon is not None and answer is not None:
        assert open_loop is not None  # the relations of the mission
        found = parts.part(find_partner, m.acquisition, data, open_loop.error, beacon, answer, light)
    budgets = (communication, *(each.budget for each in (beacon, answer) if each is not None))
    return LinkStudy(
        file=file,
        data=data,
        open_loop=open_loop,
        communication=communication,
        beacon=None if beacon is None else beacon.budget,
        answer=None if answer is None else answer.budget,
        receiver_noise=noise,
        largest_rate_bit_s=largest_rate(data),
        tornados=tornados(m, sources, budgets),
        under_jitter=performance_under_jitter(data),
        tracking=light,
        point_ahead=point_ahead(data),
        beam_radius=beam_radius(data),
        finding=found,
        fading=fading_of(data, file.path.parent, sources),
        ground=ground_link(m, sources, data),
    )


def communication_budget(data: link.DataLink, sources: Mapping[str, Source]) -> link.LinkBudget:
    """The budget of the communication link at `outage.error_rad`, with the static margin under a jitter.

    Args:
        data: The communication link.
        sources: Where each value of the mission comes from, by its dotted key.

    Raises:
        ValueError: For a data rate that the receiver does not take.
    """
    if data.jitter is None:
        return link.communication_budget(data, sources)
    alone = data if data.turbulent is None else link.assembled(data.shared, data.table, data.requirement, None)
    static = link.communication_budget(alone, sources)  # what fades add to a jitter is not what they take alone
    stated = source_text(sources, "jitter.bias", "jitter.rms", "requirement.outage")
    given = f"error that the jitter exceeds for {100 * stated_outage(data.requirement):g} % of the time: {stated}"
    found = link.communication_budget(data, sources, pointing_error_rad=error_rad(data), given_source=given)
    basis = f"at {format_quantity(data.table.pointing_error_rad, 'rad')} of pointing error, without the jitter"
    line = replace(static.totals[-1], name=STATIC_MARGIN, basis=basis)
    return replace(found, totals=(*found.totals, line))


def tornados(
    m: LinkMission, sources: Mapping[str, Source], budgets: tuple[link.LinkBudget, ...]
) -> tuple[link.Tornado, ...]:
    """What moves the margin of each budget, communication first.

    Args:
        m: The mission's tables on its links.
        sources: Where each value of the mission comes from, by its dotted key.
        budgets: The budgets, that of communication first.
    """
    tables = ("jitter", "requirement", *link.LINK_TABLES)
    swings = [link.swings(m, sources, tables, m.conventions.strehl, _margin_db, link.beam_passes)]
    swings += [variation.beam_tornado(m, sources, each.name.lower()) for each in budgets[1:]]
    return tuple(link.Tornado(each.name, each.margin_db, own) for each, own in zip(budgets, swings, strict=True))


def _margin_db(m: LinkMission) -> float:
    return margin_db(link.of(m))


def beam_radius(data: link.DataLink) -> BeamRadius | None:
    """What another radius of the data's beam would bring, or None where the mission gives none.

    An aperture that grows while the radius stays gives no more light: the radius has to grow with it.
    """
    beam = data.table.beam
    if beam is None or beam.radius_m is None:
        return None
    radii = [*(data.shared.terminals.leo_aperture_m / 2.0 * _OF_APERTURE), beam.radius_m]

    def at(radius_m: float) -> float:
        table = data.table.with_value("beam.radius_m", radius_m)
        try:
            changed = assembly.assembled(data.shared, table, data.requirement, data.jitter)
        except ValueError:  # the obscuration stops it
            return -math.inf
        return variation.margin_or_none(changed, margin_db)

    margins = [at(float(each)) for each in radii]
    best = max(range(len(radii)), key=margins.__getitem__)
    return BeamRadius(float(radii[best]), margins[best] - margins[-1])


def largest_rate(data: link.DataLink) -> float:
    """Data rate with the required margin at `under_jitter.required_error_rad`, or nan when there is none."""
    try:
        return link.largest_data_rate(data, data.requirement.margin_db, required_error_rad(data))
    except link.LinkError:
        return math.nan


def point_ahead(data: link.DataLink) -> PointAheadEffect | None:
    """The mission's point-ahead compared with its beam and its mirror, or None where it is not given."""
    ahead = data.shared.point_ahead
    if ahead is None:
        return None
    angle = pointing.point_ahead_rad(ahead.transverse_velocity_m_s)
    fall, error = data.beam.fall, data.table.pointing_error_rad
    loss = float(fall.loss_db(error + angle) - fall.loss_db(error))
    return PointAheadEffect(angle, ahead.corrected, angle / fall.half_angle_rad, loss, 2.0 * angle)
