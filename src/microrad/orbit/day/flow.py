"""From contacts to data: rates that the link closes at, acquisitions drawn, the store, volumes and latencies."""

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from microrad import link, orbit
from microrad.core.arrays import Floats
from microrad.link.acquisition.partner_search import Found
from microrad.mission.tables.operations import Downlink, Operations
from microrad.orbit import operations
from microrad.orbit.day.geometry import View, cut_at, longest_gap_s

DIRECT = "direct downlink"


@dataclass(frozen=True, slots=True)
class PointingLoss:
    """What pointing costs the laser link: the loss in dB, the share of time in outage, and where both come from.

    Both are those at the budgeted rate and distance, and are taken for every range and rate.
    """

    loss_db: float
    outage: float
    source: str


@dataclass(frozen=True, slots=True)
class Closing:
    """A data rate with the margin that it has at the budgeted distance, and the largest range at which it closes."""

    rate_bit_s: float
    margin_db: float
    largest_range_m: float


@dataclass(frozen=True, slots=True, eq=False)
class Way:
    """One way down: its contacts, what they could carry, and what happened to the instrument's data.

    ``contacts`` are those of the span, cut at its end, passes over ``stations`` for a downlink; ``carried_bit`` is what
    each could carry, and ``capacity_bit`` their sum, both the mean of the runs; ``capacity_spread_bit`` the least and
    the most of a run. ``contact_s`` is the time in contact, ``gap_s`` the longest time without one, begun in the span.
    ``history`` is the store in the first run; volumes are means over the runs, and ``latency`` is that of all runs
    together.
    """

    name: str
    contacts: tuple[orbit.Contact, ...]
    stations: tuple[str, ...]
    contact_s: float
    gap_s: float
    carried_bit: Floats
    capacity_bit: float
    capacity_spread_bit: tuple[float, float]
    generated_bit: float
    lost_bit: float
    on_board_bit: float
    failed_contacts: float
    history: operations.StoreHistory
    latency: operations.Latency

    @property
    def arrived_bit(self) -> float:
        """The instrument's data that arrive."""
        return max(self.generated_bit - self.lost_bit - self.on_board_bit, 0.0)

    @property
    def median_s(self) -> float:
        """Median latency of the data that was kept; infinite when less than half arrived."""
        return self.latency.quantile(0.5)

    @property
    def slow_s(self) -> float:
        """Latency within which 99 % of the data that was kept arrived; infinite when less did."""
        return self.latency.quantile(0.99)


def closings(o: Operations, data: link.DataLink, loss: PointingLoss) -> tuple[Closing, ...]:
    """The data rates of the link, highest first, each with how far it reaches; what the receiver refuses is left out.

    The link closes where it has the margin that the mission demands (`operations.margin`); how the margin falls with
    the range says `link.farther_db`.

    Args:
        o: The mission's table of operations, with the margin and, where given, the rates.
        data: The communication link at its budgeted distance.
        loss: What pointing costs it, the same at every range and rate.
    """
    rates = (data.table.data_rate_bit_s,) if o.rates_bit_s is None else o.rates_bit_s
    built, found = data.receiver, []
    available = link.received_on_axis_dbm(data) - loss.loss_db
    for rate in sorted(rates, reverse=True):
        if built is not None and rate > built.highest_data_rate_bit_s:
            continue
        margin = available - float(link.required_dbm(data, rate))
        spare = margin - o.margin_db
        found.append(Closing(rate, margin, _reach_m(data, spare)))
    return tuple(found)


def _reach_m(data: link.DataLink, spare_db: float) -> float:
    """The range (m) at which a link has lost what it had to spare at the budgeted one."""
    from scipy.optimize import brentq

    budgeted, path = data.range_m, data.shared.path
    alone = budgeted * float(10.0 ** (spare_db / 20.0))
    if path is None or path.satellite_radius_m is None or spare_db >= 0.0:
        return alone  # behind the budgeted elevation the air stays as it is there
    nearest = path.range_at(math.pi / 2.0)

    def left(range_m: float) -> float:
        return spare_db - float(link.farther_db(data, range_m))

    if left(nearest) <= 0.0:
        return nearest * float(10.0 ** (left(nearest) / 20.0))
    return float(brentq(left, nearest, budgeted, xtol=1e-3))


def rate_table(found: tuple[Closing, ...]) -> operations.RateTable | None:
    """The rates as steps of range; None where the receiver takes none."""
    steps: list[operations.Step] = []
    for c in found:  # a lower rate that reaches less far never serves
        if not steps or c.largest_range_m > steps[-1].largest_range_m:
            steps.append(operations.Step(c.rate_bit_s, c.largest_range_m))
    return operations.RateTable(tuple(steps)) if steps else None


def ratio(relay_bit: float, direct_bit: float) -> float:
    """A volume by relay over one direct: 0 where the relay carries nothing, infinite where it alone carries something.

    Args:
        relay_bit: Volume by relay, bit.
        direct_bit: Volume by the direct downlink, bit.
    """
    if direct_bit == 0.0:
        return math.inf if relay_bit > 0.0 else 0.0
    return relay_bit / direct_bit


# --------------------------------------------------------------------------------------------------------------- relay
def relay(
    o: Operations, seen: View, rates: operations.RateTable | None, outage: float, found: Found | None, slower: float
) -> Way:
    """The way by the relay: each run draws an acquisition for each contact.

    Args:
        o: The mission's table of operations.
        seen: The contacts of the two terminals.
        rates: The rates of the laser link by range; None where the receiver takes none.
        outage: Share of the time in which the link is out, from 0 to 1.
        found: The acquisition whose simulated times are drawn from; None where lock is there at once.
        slower: Factor on the times of acquisition.
    """
    granted = _granted(seen, o.relay_share)
    whole = tuple(contact for contact, _ in granted)
    bases = []
    for contact, range_m in granted:
        span = contact.start_s, contact.end_s
        dark = operations.Service(np.array(span), np.zeros(1), 1.0 - outage)
        bases.append(dark if rates is None else operations.service(rates, span, range_m, 1.0 - outage))
    locks = np.array([_locks(found, len(whole), o.seed, run, slower) for run in range(o.runs)])
    runs = [[base.locked_at(base.start_s + lock) for base, lock in zip(bases, row, strict=True)] for row in locks]
    failed = float(np.mean(np.isinf(locks[:, : _of_span(whole, seen)]).sum(axis=1)))
    return _way(seen.partner, whole, (), runs, o, seen, o.relay_delay_s, failed)


def _of_span(contacts: tuple[orbit.Contact, ...], seen: View) -> int:
    """How many of the contacts begin within the span."""
    return sum(c.start_s < seen.duration_s for c in contacts)


def _granted(seen: View, share: float) -> list[tuple[orbit.Contact, Callable[[Floats], Floats]]]:
    """The part of each contact that the relay grants, with its range over time.

    A contact that goes on behind the span is granted in two parts: what it has in the span counts by itself.
    """
    pairs = list(zip(seen.contacts, seen.range_m, strict=True))
    if share == 1.0:
        return pairs
    found, end = [], seen.duration_s
    for c, range_m in pairs:
        parts = [(c.start_s, c.end_s)] if not c.start_s < end < c.end_s else [(c.start_s, end), (end, c.end_s)]
        for first, last in parts:
            cut = orbit.Contact(first, first + share * (last - first), c.begins, f"end of the {seen.partner}'s share")
            found.append((cut, range_m))
    return found


def _locks(found: Found | None, contacts: int, seed: int, run: int, slower: float) -> Floats:
    """Seconds from the beginning of each contact to lock, infinite where acquisition is given up; drawn from its runs.

    Without an acquisition in the mission lock is there at once.
    """
    if found is None:
        return np.zeros(contacts)
    draw = np.random.Generator(np.random.Philox(key=[seed, run]))
    chosen = draw.integers(0, found.simulated.time_s.size, contacts)
    return np.where(found.simulated.locked[chosen], slower * found.simulated.time_s[chosen], math.inf)


# -------------------------------------------------------------------------------------------------------------- direct
StationPass = tuple[orbit.Pass, str]
"""A pass and the station that hears it."""


def station_passes(down: Downlink | None, pair: orbit.Pair) -> tuple[StationPass, ...]:
    """Every pass of the lower satellite over every station of the direct downlink, station by station.

    Args:
        down: The mission's table of its downlink; None where it has none, which gives no passes.
        pair: The two terminals; the lower one's orbit is searched over the span with its tail.

    Raises:
        OrbitError: For an orbit that does not hold.
    """
    return tuple(
        (each, station.name)
        for station in (() if down is None else orbit.stations(down))
        for each in orbit.passes(pair.leo.orbit, station, pair.epoch, pair.whole_s)
    )


def direct(o: Operations, seen: View, passes: tuple[StationPass, ...]) -> Way | None:
    """The way by the direct radio downlink, or None without one.

    The station that rises first is kept until the satellite sets there.

    Args:
        o: The mission's table of operations.
        seen: The contacts of the two terminals, for the span.
        passes: The passes over all stations, in any order.
    """
    down = o.downlink
    if down is None:
        return None
    kept, names, services = [], [], []
    for start, end, place in one_at_a_time((each.start_s, each.end_s, k) for k, (each, _) in enumerate(passes)):
        each, name = passes[place]
        begins = each.begins if start == each.start_s else "station free"
        kept.append(replace(each, start_s=start, begins=begins))
        names.append(name)
        whole = operations.Service(np.array([start, end]), np.array([down.data_rate_bit_s]), 1.0)
        services.append(whole.locked_at(start + down.setup_s))
    return _way(DIRECT, tuple(kept), tuple(names), [services], o, seen, down.delay_s, 0.0)


def one_at_a_time(spans: Iterable[tuple[float, float, int]]) -> list[tuple[float, float, int]]:
    """The spans that are used where only one can be at a time: the first to begin is kept to its end.

    At its end the one that began first among those that last longer takes over, for what is left of it. Of two that
    begin at one moment, as under a sky that clears, the one that ends first is used, then the other.

    Args:
        spans: Start and end in s of each, and a number that tells it apart; in any order.
    """
    kept, until = [], -math.inf
    for start, end, which in sorted(spans):
        begin = max(start, until)
        if end > begin:
            kept.append((begin, end, which))
            until = end
    return kept


# ----------------------------------------------------------------------------------------------------------------- way
def _way(
    name: str,
    contacts: tuple[orbit.Contact, ...],
    stations: tuple[str, ...],
    runs: list[list[operations.Service]],
    o: Operations,
    seen: View,
    delay_s: float,
    failed: float,
) -> Way:
    end_s, inside = seen.pair.span_s[1], _of_span(contacts, seen)
    shown = tuple(cut_at(c, end_s) for c in contacts[:inside])
    return way_of(
        name=name,
        contacts=shown,
        stations=stations[:inside],
        contact_s=sum(c.duration_s for c in shown),
        gap_s=longest_gap_s(contacts, seen.pair),
        carried=np.array([[carried_bit(s, end_s) for s in services[:inside]] for services in runs]),
        histories=[history(o, seen.pair, services, delay_s) for services in runs],
        failed=failed,
    )


def carried_bit(service: operations.Service, end_s: float) -> float:
    """What a contact could carry before the end of the span, bit.

    Args:
        service: What the contact carries.
        end_s: End of the span, s.
    """
    return float(np.dot(service.mean_rate_bit_s, np.diff(np.minimum(service.edges_s, end_s))))


def history(
    o: Operations, pair: orbit.Pair, services: Sequence[operations.Service], delay_s: float
) -> operations.StoreHistory:
    """The store in one run: the instrument fills it over the span, and contacts empty it to the end of the tail.

    Args:
        o: The mission's table of operations.
        pair: The two terminals, for the span and its tail.
        services: What the contacts carry, in order.
        delay_s: From the satellite to the user, s.
    """
    return operations.deliver(o.instrument_rate_bit_s, pair.span_s, o.store_bit, services, pair.whole_s, delay_s)


def way_of(
    name: str,
    contacts: tuple[orbit.Contact, ...],
    stations: tuple[str, ...],
    contact_s: float,
    gap_s: float,
    carried: Floats,
    histories: Sequence[operations.StoreHistory],
    failed: float = 0.0,
) -> Way:
    """A way down from its runs.

    Args:
        name: What it is called.
        contacts: Those of the span, cut at its end.
        stations: The station of each, where they are passes.
        contact_s: Time in contact, s.
        gap_s: Longest time without one, s.
        carried: What each contact could carry in each run, bit, shape (runs, contacts).
        histories: The store in each run.
        failed: Contacts without acquisition, the mean of the runs.
    """
    carried = carried.reshape(len(histories), -1)
    total = carried.sum(axis=1)
    return Way(
        name=name,
        contacts=contacts,
        stations=stations,
        contact_s=contact_s,
        gap_s=gap_s,
        carried_bit=carried.mean(axis=0),
        capacity_bit=float(total.mean()),
        capacity_spread_bit=(float(total.min()), float(total.max())),
        generated_bit=float(histories[0].generated_bit[-1]),
        lost_bit=float(np.mean([h.lost_bit[-1] for h in histories])),
        on_board_bit=float(np.mean([h.stored_bit[-1] for h in histories])),
        failed_contacts=failed,
        history=histories[0],
        latency=operations.pool([h.latency for h in histories]),
    )
