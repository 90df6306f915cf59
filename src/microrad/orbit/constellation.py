"""Many satellites that share a few relays: who sees whom, who is served when, and the plan of it."""

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from microrad import link, orbit
from microrad.core.arrays import Floats
from microrad.core.progress import Progress
from microrad.mission.file import LinkFile
from microrad.orbit import operations
from microrad.orbit.base import required
from microrad.orbit.day.flow import PointingLoss, closings, rate_table
from microrad.orbit.visibility.contacts import Sampled, coarse_step_s, contacts_with_each

Span = tuple[float, float]

_EDGE = 1e-9  # part of a range by which a session that ends at a limit may seem to exceed it
_RANGES = 25  # samples of a session


@dataclass(frozen=True, slots=True, eq=False)
class ConstellationPlan:
    """Who is served when. Times in seconds since ``epoch``; satellites and relays count from 0 in the order of names.

    ``opportunities`` are all contacts, ``sessions`` those that the relays' terminals take, ``planned`` the same with
    their names, ranges, rates and volumes, under ``loss``. ``by_satellite`` and ``by_relay`` add them up.
    """

    epoch: orbit.Epoch
    span_s: Span
    satellites: tuple[str, ...]
    relays: tuple[str, ...]
    terminals: int
    opportunities: operations.Opportunities
    sessions: operations.Sessions
    planned: tuple[operations.PlannedSession, ...]
    loss: PointingLoss
    by_satellite: operations.Totals
    by_relay: operations.Totals

    def contact_plan(self) -> str:
        """The sessions as a contact plan, see `operations.contact_plan`; nodes are numbered in the order of names."""
        return operations.contact_plan(self.planned, self.epoch.utc, satellites=self.satellites, relays=self.relays)

    @property
    def volume_bit(self) -> float:
        """Data of all sessions."""
        return sum(one.volume_bit for one in self.planned)

    @property
    def use(self) -> Floats:
        """Share of the span in which the terminals of each relay are busy."""
        return np.asarray(self.by_relay.busy_s / (self.terminals * (self.span_s[1] - self.span_s[0])))


def opportunities(
    satellites: Iterable[orbit.Terminal],
    relays: Sequence[orbit.Terminal],
    earth: orbit.Earth,
    epoch: orbit.Epoch,
    span_s: Span,
    furthest_m: float = math.inf,
    on_progress: Callable[[int], None] = lambda done: None,
) -> operations.Opportunities:
    """Every contact of every satellite with every relay up to a range, in order of their start.

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

    Raises:
        OrbitError: As `orbit.contacts`.
    """
    rows: list[tuple[int, int, float, float]] = []
    sampled: dict[float, list[Sampled]] = {}
    for place, satellite in enumerate(satellites):
        step = coarse_step_s(satellite.orbit, span_s[0])
        if step not in sampled:
            sampled[step] = [Sampled.over(relay.orbit, span_s, step) for relay in relays]
        each = contacts_with_each(satellite, relays, earth, epoch, span_s, sampled[step], furthest_m)
        rows += [(place, which, c.start_s, c.end_s) for which, found in enumerate(each) for c in found]
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
    at its largest range. Volumes leave out the share of time in outage.

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
    relays = orbit.relays(c, orbits, pair.epoch)
    furthest = 0.0 if rates is None else rates.steps[-1].largest_range_m
    found = opportunities(
        own,
        relays,
        pair.earth,
        pair.epoch,
        pair.span_s,
        furthest,
        lambda done: on_progress(done, len(own), "contacts of the constellation"),
    )
    rules = operations.Rules(c.overhead_s, c.shortest_s, c.session_s)
    sessions = operations.schedule(found, len(own), len(relays), c.terminals, rules, pair.span_s[0])
    planned = _planned(rates, own, relays, sessions, 1.0 - loss.outage)
    volumes = [one.volume_bit for one in planned]
    return ConstellationPlan(
        epoch=pair.epoch,
        span_s=pair.span_s,
        satellites=tuple(each.name for each in own),
        relays=tuple(each.name for each in relays),
        terminals=c.terminals,
        opportunities=found,
        sessions=sessions,
        planned=planned,
        loss=loss,
        by_satellite=operations.totals(sessions, sessions.satellite, len(own), volumes, pair.span_s),
        by_relay=operations.totals(sessions, sessions.relay, len(relays), volumes, pair.span_s),
    )


def _planned(
    rates: operations.RateTable | None,
    satellites: Sequence[orbit.Terminal],
    relays: Sequence[orbit.Terminal],
    s: operations.Sessions,
    availability: float,
) -> tuple[operations.PlannedSession, ...]:
    found = []
    for one in range(s.satellite.size):
        own, relay = satellites[s.satellite[one]], relays[s.relay[one]]
        time_s = np.linspace(s.locked_s[one], s.end_s[one], _RANGES)
        range_m = orbit.sight(own.orbit, relay.orbit, time_s).range_m
        furthest = float(np.max(range_m))
        rate = 0.0 if rates is None else float(rates.rate_bit_s(furthest * (1.0 - _EDGE)))
        found.append(
            operations.PlannedSession(
                satellite=own.name,
                relay=relay.name,
                start_s=float(s.start_s[one]),
                locked_s=float(s.locked_s[one]),
                end_s=float(s.end_s[one]),
                rate_bit_s=rate,
                volume_bit=rate * availability * float(s.end_s[one] - s.locked_s[one]),
                range_min_m=float(np.min(range_m)),
                range_max_m=furthest,
            )
        )
    return tuple(found)
