"""Many satellites that share a few relays and ground stations: who sees whom, who is served when, and its plan."""

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, fields

import numpy as np

from microrad import link, orbit
from microrad.core.arrays import Floats
from microrad.core.progress import Progress
from microrad.mission.file import LinkFile
from microrad.mission.tables.operations import Constellation
from microrad.orbit import operations
from microrad.orbit.base import required
from microrad.orbit.day.flow import PointingLoss, closings, rate_table
from microrad.orbit.day.weather import Site, mean_availability
from microrad.orbit.visibility.contacts import Sampled, coarse_step_s, contacts_with_each
from microrad.orbit.visibility.stations import StationRows, pass_spans

Span = tuple[float, float]


@dataclass(frozen=True, slots=True)
class Ground:
    """A ground station that satellites share, with its rates by range, its terminals and when it can be used.

    ``site`` has the share of the time in which it can be used, which counts as a factor on its volumes.
    """

    station: orbit.Station
    site: Site
    rates: operations.RateTable
    terminals: int

    @property
    def reach_m(self) -> float:
        """Range up to which the lowest of its rates closes, m."""
        return self.rates.steps[-1].largest_range_m


_EDGE = 1e-9  # part of a range by which a session that ends at a limit may seem to exceed it
_RANGES = 25  # samples of a session


@dataclass(frozen=True, slots=True, eq=False)
class ConstellationPlan:
    """Who is served when. Times in seconds since ``epoch``; satellites and relays count from 0 in the order of names.

    Ground ``stations`` count behind the relays. ``opportunities`` are all contacts, ``sessions`` those that the
    terminals take, ``planned`` the same with their names, ranges, rates and volumes, under ``loss``. ``by_satellite``,
    ``by_relay`` and ``by_station`` add them up. Each relay has ``terminals``, each station its ``station_terminals``.
    """

    epoch: orbit.Epoch
    span_s: Span
    satellites: tuple[str, ...]
    relays: tuple[str, ...]
    stations: tuple[str, ...]
    terminals: int
    station_terminals: tuple[int, ...]
    opportunities: operations.Opportunities
    sessions: operations.Sessions
    planned: tuple[operations.PlannedSession, ...]
    loss: PointingLoss
    by_satellite: operations.Totals
    by_relay: operations.Totals
    by_station: operations.Totals

    def contact_plan(self) -> str:
        """The sessions as a contact plan, see `operations.contact_plan`; nodes are numbered in the order of names."""
        partners = (*self.relays, *self.stations)
        return operations.contact_plan(self.planned, self.epoch.utc, satellites=self.satellites, relays=partners)

    @property
    def volume_bit(self) -> float:
        """Data of all sessions."""
        return sum(one.volume_bit for one in self.planned)

    @property
    def use(self) -> Floats:
        """Share of the span in which the terminals of each relay are busy."""
        return np.asarray(self.by_relay.busy_s / (self.terminals * (self.span_s[1] - self.span_s[0])))

    @property
    def station_use(self) -> Floats:
        """The same of each ground station."""
        terminals = np.array(self.station_terminals, dtype=np.float64)
        return np.asarray(self.by_station.busy_s / (terminals * (self.span_s[1] - self.span_s[0])))


def opportunities(
    satellites: Iterable[orbit.Terminal],
    relays: Sequence[orbit.Terminal],
    earth: orbit.Earth,
    epoch: orbit.Epoch,
    span_s: Span,
    furthest_m: float = math.inf,
    on_progress: Callable[[int], None] = lambda done: None,
    stations: Sequence[Ground] = (),
) -> operations.Opportunities:
    """Every contact of every satellite with every relay up to a range and every station, in order of their start.

    The satellites are searched one after the other, as the work is many small arrays, for which threads only wait on
    one another. The time grows with the number of satellites, and what is kept with the number of contacts.

    Args:
        satellites: The satellites on their orbits, counted from 0 in this order.
        relays: The relays on theirs, likewise.
        earth: What hides one from the other.
        epoch: Instant from which all times count.
        span_s: Start and end of the search, s.
        furthest_m: Largest range of a contact, m; infinite without a limit.
        on_progress: Called with the number of satellites that are searched.
        stations: Ground stations, counted behind the relays; with them a satellite has contact above the mask
            (`orbit.passes`), whatever its terminal's own limits are.

    Raises:
        OrbitError: As `orbit.contacts`, and for a satellite and a station of one name.
    """
    names, ground = {s.station.name for s in stations}, StationRows.of([s.station for s in stations], epoch)
    reach = [s.reach_m for s in stations]
    rows: list[tuple[int, int, float, float]] = []
    sampled: dict[float, list[Sampled]] = {}
    for place, satellite in enumerate(satellites):
        step = coarse_step_s(satellite.orbit, span_s[0])
        if step not in sampled:
            sampled[step] = [Sampled.over(relay.orbit, span_s, step) for relay in relays]
        each = contacts_with_each(satellite, relays, earth, epoch, span_s, sampled[step], furthest_m)
        rows += [(place, which, c.start_s, c.end_s) for which, found in enumerate(each) for c in found]
        if satellite.name in names:
            raise orbit.OrbitError(f'a satellite and a station are called "{satellite.name}"; give each its own name')
        for which, spans in enumerate(pass_spans(satellite.orbit, ground, span_s, step, reach), len(relays)):
            rows += [(place, which, start, end) for start, end in spans.tolist()]
        on_progress(place + 1)
    table = np.array(rows, dtype=np.float64).reshape(-1, 4)
    order = np.lexsort((table[:, 1], table[:, 0], table[:, 2]))
    who, when = table[order, :2].astype(np.int64), table[order, 2:]
    return operations.Opportunities(who[:, 0], who[:, 1], when[:, 0], when[:, 1])


def run_constellation(
    file: LinkFile, loss: PointingLoss, on_progress: Progress = lambda done, total, what: None
) -> ConstellationPlan:
    """The constellation of a mission: contacts, sessions by the rule of `operations.schedule`, and their volumes.

    A session takes place where the link closes at the lowest of its rates at least; its rate is the highest that closes
    at its largest range. Volumes leave out the share of time in outage. Sessions with a ground station have its data
    rate; their volumes are those expected under its availability in the months of the session, and the schedule does
    not know the weather.

    Args:
        file: The mission, with the files that it names.
        loss: What pointing costs the laser link.
        on_progress: Told how many of how many satellites are searched.

    Raises:
        OperationsError: Without the tables `constellation` and `operations`.
        OrbitError: Without the table `orbit`, and for orbits that do not hold.
    """
    m, folder, contents = file.mission, file.path.parent, file.contents
    c = required(m.constellation, "constellation", operations.OperationsError)
    rates = rate_table(closings(required(m.operations, "operations", operations.OperationsError), link.of(m), loss))
    orbits, pair = required(m.orbit, "orbit", orbit.OrbitError), orbit.pair(m.orbit, m.terminals, folder, contents)
    own = tuple(orbit.satellites(c, orbits, pair.epoch, folder, contents))
    relays, ground = orbit.relays(c, orbits, pair.epoch), grounds(c)
    furthest = 0.0 if rates is None else rates.steps[-1].largest_range_m
    found = opportunities(
        own,
        relays,
        pair.earth,
        pair.epoch,
        pair.span_s,
        furthest,
        lambda done: on_progress(done, len(own), "contacts of the constellation"),
        ground,
    )
    rules = operations.Rules(c.overhead_s, c.shortest_s, c.session_s)
    terminals = [*[c.terminals] * len(relays), *(g.terminals for g in ground)]
    sessions = operations.schedule(found, len(own), len(terminals), terminals, rules, pair.span_s[0])
    partners = (*relays, *ground)
    times = zip(sessions.start_s.tolist(), sessions.locked_s.tolist(), sessions.end_s.tolist(), strict=True)
    planned = tuple(
        _planned(own[s], partners[p], pair.epoch, rates, loss.outage, when)
        for s, p, when in zip(sessions.satellite.tolist(), sessions.relay.tolist(), times, strict=True)
    )
    volumes = [one.volume_bit for one in planned]
    by_partner = operations.totals(sessions, sessions.relay, len(terminals), volumes, pair.span_s)
    return ConstellationPlan(
        epoch=pair.epoch,
        span_s=pair.span_s,
        satellites=tuple(each.name for each in own),
        relays=tuple(each.name for each in relays),
        stations=tuple(each.station.name for each in ground),
        terminals=c.terminals,
        station_terminals=tuple(each.terminals for each in ground),
        opportunities=found,
        sessions=sessions,
        planned=planned,
        loss=loss,
        by_satellite=operations.totals(sessions, sessions.satellite, len(own), volumes, pair.span_s),
        by_relay=_part(by_partner, slice(0, len(relays))),
        by_station=_part(by_partner, slice(len(relays), None)),
    )


def grounds(c: Constellation) -> tuple[Ground, ...]:
    """The ground stations that a constellation shares, each with one rate at every range above its mask.

    Args:
        c: The mission's table of its constellation.
    """
    return tuple(
        Ground(
            station,
            Site(station.name, s.latitude_rad, s.longitude_rad, s.availability),
            operations.RateTable((operations.Step(s.data_rate_bit_s, math.inf),)),
            s.terminals,
        )
        for station, s in zip(orbit.stations(c), c.stations.values(), strict=True)
    )


def _planned(
    satellite: orbit.Terminal,
    partner: orbit.Terminal | Ground,
    epoch: orbit.Epoch,
    rates: operations.RateTable | None,
    outage: float,
    times_s: tuple[float, float, float],
) -> operations.PlannedSession:
    """A session with its rate and its volume; its times are those of start, lock and end."""
    start_s, locked_s, end_s = times_s
    time_s = np.linspace(locked_s, end_s, _RANGES)
    if isinstance(partner, Ground):
        name, rates = partner.station.name, partner.rates
        range_m = orbit.station_range(satellite.orbit, partner.station, epoch)(time_s)
        availability = mean_availability(partner.site, epoch, (locked_s, end_s))
    else:
        name, availability = partner.name, 1.0 - outage
        range_m = orbit.sight(satellite.orbit, partner.orbit, time_s).range_m
    furthest = float(np.max(range_m))
    rate = 0.0 if rates is None else float(rates.rate_bit_s(furthest * (1.0 - _EDGE)))
    return operations.PlannedSession(
        satellite=satellite.name,
        relay=name,
        start_s=start_s,
        locked_s=locked_s,
        end_s=end_s,
        rate_bit_s=rate,
        volume_bit=rate * availability * (end_s - locked_s),
        range_min_m=float(np.min(range_m)),
        range_max_m=furthest,
    )


def _part(whole: operations.Totals, which: slice) -> operations.Totals:
    """The totals of some of the partners."""
    return operations.Totals(**{each.name: getattr(whole, each.name)[which] for each in fields(whole)})
