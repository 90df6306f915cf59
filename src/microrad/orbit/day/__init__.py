"""What a link delivers in a day: contacts, acquisition, rates, volume and latency, by relay and to the ground."""

from dataclasses import dataclass
from functools import partial

from microrad import link, orbit
from microrad.core.progress import Progress
from microrad.core.units import format_quantity
from microrad.link.acquisition.partner_search import Found
from microrad.link.requirement import derived_from
from microrad.link.study import LinkStudy
from microrad.mission.file import LinkFile
from microrad.mission.tables.operations import Operations
from microrad.orbit import operations
from microrad.orbit.base import required
from microrad.orbit.day import flow
from microrad.orbit.day.assumptions import NOTHING, Case, Known, Numbers, Swing, swings
from microrad.orbit.day.flow import Closing, PointingLoss, Way
from microrad.orbit.day.geometry import Encounter, View, beyond_the_mission, encounter, short_tail, times, view
from microrad.orbit.day.optical import Sky, optical, optical_passes, sky

__all__ = [
    "NOTHING",
    "Closing",
    "DayStudy",
    "Encounter",
    "Numbers",
    "PointingLoss",
    "Sky",
    "Swing",
    "Way",
    "given_loss",
    "loss_at",
    "optical_alone",
    "relay",
    "run_day_study",
    "times",
    "view",
]


@dataclass(frozen=True, slots=True, eq=False)
class DayStudy:
    """The span of a mission by its ways, and the assumptions that move the comparison, the weightiest first.

    ``operations`` is the mission's table, ``data`` its communication link. ``encounters`` are the contacts of the relay
    as it grants them, with what their line of sight reaches. ``closings`` are the laser's rates, highest first, with
    how far each reaches under ``loss``; ``derived`` are the inputs of the laser link that were chosen for its margin
    (`requirement.derived_from`), so that its reach follows from that choice. ``direct`` is the radio downlink and
    ``optical`` that by optical ground stations under the ``sky``; each is None in a mission without it.
    """

    operations: Operations
    data: link.DataLink
    view: View
    encounters: tuple[Encounter, ...]
    loss: PointingLoss
    closings: tuple[Closing, ...]
    derived: tuple[str, ...]
    relay: Way
    direct: Way | None
    optical: Way | None
    sky: Sky | None
    swings: tuple[Swing, ...]
    warnings: tuple[str, ...]

    @property
    def ratio(self) -> float:
        """Volume that the relay could carry over that of the direct downlink (`flow.ratio`); nan without one."""
        return float("nan") if self.direct is None else flow.ratio(self.relay.capacity_bit, self.direct.capacity_bit)

    @property
    def optical_ratio(self) -> float:
        """Volume that the relay could carry over that of the optical downlink (`flow.ratio`); nan without one."""
        return float("nan") if self.optical is None else flow.ratio(self.relay.capacity_bit, self.optical.capacity_bit)

    @property
    def ways(self) -> tuple[Way, ...]:
        """The relay, and the ways to the ground that the mission has."""
        return tuple(way for way in (self.relay, self.direct, self.optical) if way is not None)


def given_loss(links: LinkStudy) -> PointingLoss:
    """The pointing loss of a mission whose loop is not simulated: that of its jitter, else of its pointing error."""
    if links.under_jitter is not None:
        return PointingLoss(links.under_jitter.outage_loss_db, links.under_jitter.outage, "jitter as given")
    error = format_quantity(links.data.table.pointing_error_rad, "rad")
    return loss_at(links.data, links.communication.margin_db, f"communication.pointing_error, {error}")


def loss_at(data: link.DataLink, margin_db: float, source: str) -> PointingLoss:
    """The pointing loss, an uncorrected point-ahead in it, that leaves a margin at the budgeted rate and distance.

    Args:
        data: The communication link.
        margin_db: Its margin, dB.
        source: Where the margin comes from, in words.
    """
    needed = float(link.required_dbm(data, data.table.data_rate_bit_s))
    return PointingLoss(link.received_on_axis_dbm(data) - needed - margin_db, 0.0, source)


def _begin(links: LinkStudy) -> tuple[Operations, partial[orbit.Pair], View, Found | None]:
    """The table of operations; what makes the terminals of given orbits; their contacts, and their acquisition."""
    m, file = links.file.mission, links.file
    pair_of = partial(orbit.pair, ends=m.terminals, folder=file.path.parent, contents=file.contents)
    seen = view(pair_of(m.orbit), m.communication.wavelength_m)
    o = required(m.operations, "operations", operations.OperationsError)
    return o, pair_of, seen, None if links.finding is None else links.finding.way(o.acquisition)


def relay(links: LinkStudy, loss: PointingLoss) -> Way:
    """The way by the relay alone: what `run_day_study` finds of it, without the rest of the day.

    Args:
        links: The links of the mission, with their acquisition.
        loss: What pointing costs the laser link.
    """
    o, _, seen, found = _begin(links)
    return flow.relay(o, seen, flow.rate_table(flow.closings(o, links.data, loss)), loss.outage, found, 1.0)


def optical_alone(file: LinkFile) -> Way | None:
    """The way by the optical downlink alone: what `run_day_study` finds of it; None in a mission without one.

    Args:
        file: The mission, with the files that it names.

    Raises:
        OrbitError: Without the table `orbit`, and for orbits that do not hold.
        OperationsError: Without the table `operations`.
    """
    m = file.mission
    pair = orbit.pair(m.orbit, m.terminals, file.path.parent, file.contents)
    o = required(m.operations, "operations", operations.OperationsError)
    return optical(o, pair, optical_passes(o.optical, pair))


def run_day_study(
    links: LinkStudy, loss: PointingLoss | None = None, on_progress: Progress = lambda done, total, what: None
) -> DayStudy:
    """The day of a mission that has the tables `orbit` and `operations`.

    Args:
        links: The links of the mission, with their acquisition.
        loss: What pointing costs the laser link; by default what the mission states.
        on_progress: Told how many of how many assumptions are changed.

    Raises:
        OrbitError: Without the table `orbit`, and for orbits that do not hold.
        OperationsError: Without the table `operations`, and for a contact that is asked for beyond those of the span.
    """
    m = links.file.mission
    loss = given_loss(links) if loss is None else loss
    o, pair_of, seen, found = _begin(links)
    if o.contact is not None and seen.encounters and o.contact.number > len(seen.encounters):
        raise operations.OperationsError(
            f"operations.contact.number is {o.contact.number}, and the span has {len(seen.encounters)} contacts: give "
            "a number up to that, or a longer orbit.duration"
        )
    closing = flow.closings(o, links.data, loss)
    heard, lit = flow.station_passes(o.downlink, seen.pair), optical_passes(o.optical, seen.pair)
    relay = flow.relay(o, seen, flow.rate_table(closing), loss.outage, found, 1.0)
    assert m.orbit is not None  # else there are no terminals
    known = Known(Case(o, m.orbit, links.data, loss), pair_of, seen, heard, found, lit)
    return DayStudy(
        operations=o,
        data=links.data,
        view=seen,
        loss=loss,
        closings=closing,
        derived=derived_from(links.file.sources, "communication."),
        encounters=tuple(encounter(seen.pair, contact, m.communication.wavelength_m) for contact in relay.contacts),
        relay=relay,
        direct=flow.direct(o, seen, heard),
        optical=optical(o, seen.pair, lit),
        sky=sky(o, seen.pair),
        swings=swings(known, on_progress),
        warnings=(*beyond_the_mission(m, seen), *short_tail(seen.pair)),
    )
