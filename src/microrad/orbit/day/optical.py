"""The optical downlink: a network of ground stations under clouds, of which one at a time takes the data."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from microrad import orbit
from microrad.core.arrays import Floats
from microrad.mission.tables.operations import Operations, OpticalDownlink
from microrad.orbit import operations
from microrad.orbit.day.flow import Way, carried_bit, history, one_at_a_time, way_of
from microrad.orbit.day.geometry import cut_at, longest_gap_s
from microrad.orbit.day.weather import Site, Weather, any_clear, clear_spells, correlation, mean_availability
from microrad.orbit.operations.rates import Range
from microrad.orbit.visibility.events import union

OPTICAL = "optical downlink"


class OpticalPass(NamedTuple):
    """A pass over a station of the network, which counts from 0, with the range over time."""

    each: orbit.Pass
    station: int
    range_m: Range


@dataclass(frozen=True, slots=True, eq=False)
class Sky:
    """How often the sites of the network are clear over the span.

    ``availability`` is what the table says of each of the ``names``, over the span, and ``drawn`` its share in the
    runs. ``any_clear`` is the share of the time in which at least one site is clear, by the joint distribution
    (`weather.any_clear`); ``any_drawn`` that in the runs, and ``any_independent`` what it would be if clouds over one
    site said nothing of the others. ``correlation`` has the shape (sites, sites).
    """

    names: tuple[str, ...]
    availability: tuple[float, ...]
    drawn: tuple[float, ...]
    any_clear: float
    any_drawn: float
    any_independent: float
    correlation: Floats


def weather_of(down: OpticalDownlink, epoch: orbit.Epoch) -> Weather:
    """The weather over the network of a mission.

    Args:
        down: Its table of the optical downlink.
        epoch: Instant from which times count.
    """
    sites = tuple(Site(n, s.latitude_rad, s.longitude_rad, s.availability) for n, s in down.stations.items())
    return Weather(epoch, sites, down.weather_s, correlation(sites, down.correlation_length_m))


def optical_passes(down: OpticalDownlink | None, pair: orbit.Pair) -> tuple[OpticalPass, ...]:
    """Every pass of the lower satellite over every station of the network, station by station.

    Args:
        down: The mission's table of its optical downlink; None where it has none, which gives no passes.
        pair: The two terminals; the lower one's orbit is searched over the span with its tail.

    Raises:
        OrbitError: For an orbit that does not hold.
    """
    own, epoch, found = pair.leo.orbit, pair.epoch, []
    for place, station in enumerate(() if down is None else orbit.stations(down)):
        range_m = orbit.station_range(own, station, epoch)
        found += [OpticalPass(each, place, range_m) for each in orbit.passes(own, station, epoch, pair.whole_s)]
    return tuple(found)


def constant_rate(down: OpticalDownlink) -> operations.RateTable:
    """The rate of the network: one, at every range."""
    return operations.RateTable((operations.Step(down.data_rate_bit_s, math.inf),))


def optical(
    o: Operations, pair: orbit.Pair, passes: Sequence[OpticalPass], rates: operations.RateTable | None = None
) -> Way | None:
    """The way by the optical downlink, or None without one: each run draws the weather over the stations.

    A station can be used while it is clear and the satellite is above its mask. One station is used at a time: the
    one for which that begins first is kept until the satellite sets there or clouds come in. Then the one that could
    be used first among those that can be used takes over, or the next for which it begins. Data flow from
    `operations.optical.setup` after a station has taken over. The satellite knows which stations are clear.

    The contacts of the way are the passes in which data flow in some run; they may overlap. Time in contact and the
    longest gap are those of the stations in use, the mean of the runs.

    Args:
        o: The mission's table of operations.
        pair: The two terminals, for the span and its tail.
        passes: The passes over all stations.
        rates: The data rates by range; that of the table (`constant_rate`) by default.
    """
    down = o.optical
    if down is None:
        return None
    rates = constant_rate(down) if rates is None else rates
    whole = [operations.service(rates, (p.each.start_s, p.each.end_s), p.range_m, 1.0) for p in passes]
    weather, end_s = weather_of(down, pair.epoch), pair.span_s[1]
    carried, in_use_s, gaps_s, histories = np.zeros((o.runs, len(passes))), [], [], []
    for run in range(o.runs):
        used = _used(passes, clear_spells(weather, pair.whole_s, o.seed, run))
        services = [whole[k].within(start, end).locked_at(start + down.setup_s) for start, end, k in used]
        for (start, _, k), service in zip(used, services, strict=True):
            carried[run, k] += carried_bit(service, end_s) if start < end_s else 0.0
        in_use_s.append(sum(max(min(end, end_s) - start, 0.0) for start, end, _ in used))
        gaps_s.append(longest_gap_s([orbit.Contact(start, end, "", "") for start, end, _ in used], pair))
        histories.append(history(o, pair, services, down.delay_s))
    served = sorted(np.flatnonzero(carried.any(axis=0)).tolist(), key=lambda k: (passes[k].each.start_s, k))
    names = tuple(down.stations)
    return way_of(
        name=OPTICAL,
        contacts=tuple(cut_at(passes[k].each, end_s) for k in served),
        stations=tuple(names[passes[k].station] for k in served),
        contact_s=float(np.mean(in_use_s)),
        gap_s=float(np.mean(gaps_s)),
        carried=carried[:, served],
        histories=histories,
    )


def _used(passes: Sequence[OpticalPass], clear: Sequence[Floats]) -> list[tuple[float, float, int]]:
    """Start and end of each use of a station, s, and the number of its pass; in order."""
    could = []
    for place, (each, station, _) in enumerate(passes):
        begins, ends = np.maximum(clear[station][:, 0], each.start_s), np.minimum(clear[station][:, 1], each.end_s)
        could += [(b, e, place) for b, e in zip(begins.tolist(), ends.tolist(), strict=True) if b < e]
    return one_at_a_time(could)


def sky(o: Operations, pair: orbit.Pair) -> Sky | None:
    """How often the sites of the optical downlink are clear over the span; None without one.

    Args:
        o: The mission's table of operations.
        pair: The two terminals, for the span.
    """
    if o.optical is None:
        return None
    weather, span_s = weather_of(o.optical, pair.epoch), pair.span_s
    alone = Weather(weather.epoch, weather.sites, weather.holds_s, np.eye(len(weather.sites)))
    runs = [clear_spells(weather, span_s, o.seed, run) for run in range(o.runs)]
    whole_s = len(runs) * (span_s[1] - span_s[0])
    return Sky(
        names=tuple(s.name for s in weather.sites),
        availability=tuple(mean_availability(s, pair.epoch, span_s) for s in weather.sites),
        drawn=tuple(sum(_length_s(run[k]) for run in runs) / whole_s for k in range(len(weather.sites))),
        any_clear=any_clear(weather, span_s),
        any_drawn=sum(_length_s(union(*run)) for run in runs) / whole_s,
        any_independent=any_clear(alone, span_s),
        correlation=weather.correlation,
    )


def _length_s(spells: Floats) -> float:
    return float(np.sum(spells[:, 1] - spells[:, 0]))
