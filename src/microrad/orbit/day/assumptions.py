"""Which assumption moves the comparison of relay and direct downlink most: each one changed alone."""

import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace

from microrad import link, orbit
from microrad.core.units import format_quantity
from microrad.link.acquisition.partner_search import Found
from microrad.mission.tables.operations import Downlink, Operations, OpticalDownlink
from microrad.mission.tables.orbit import HIGHEST_MASK_RAD, Orbits, VisibilityLimits
from microrad.orbit.day import flow, geometry
from microrad.orbit.day.optical import OpticalPass, optical, optical_passes

_SKIES = 20  # drawn for each case: the same ones for all of them
_RUNS = 4  # of each case: what an acquisition takes is little beside what is varied
_CLOUDS_M = 500e3  # a correlation length for a mission that has none
NOTHING = "as it is"


@dataclass(frozen=True, slots=True)
class Numbers:
    """What one case comes to; nan for a downlink that the mission does not have."""

    relay_bit: float
    direct_bit: float
    relay_slow_s: float
    direct_slow_s: float
    optical_bit: float = math.nan
    optical_slow_s: float = math.nan

    @property
    def ratio(self) -> float:
        """Volume that the relay could carry over that of the direct downlink; 0 where the relay carries nothing."""
        return flow.ratio(self.relay_bit, self.direct_bit)


@dataclass(frozen=True, slots=True)
class Swing:
    """One assumption changed to ``low`` and to ``high``, in words, all others as they are; a side may be unchanged.

    ``here`` is what all are compared with: every assumption as it is.
    """

    name: str
    low: str
    high: str
    at_low: Numbers
    at_high: Numbers
    here: Numbers

    @property
    def factor(self) -> float:
        """The larger of `of_relay` and `of_optical`."""
        return max(self.of_relay, self.of_optical)

    @property
    def of_relay(self) -> float:
        """Largest over smallest ratio of relay and direct downlink, as it is and at both sides.

        Without a direct downlink, and where that carries nothing in any case, it is the relay's volume that counts.
        Infinite where one of them is nothing.
        """
        every = self.here, self.at_low, self.at_high
        alone = not any(n.direct_bit > 0.0 for n in every)
        return _spread(n.relay_bit if alone else n.ratio for n in every)

    @property
    def of_optical(self) -> float:
        """Largest over smallest volume of the optical downlink, likewise; 1 without one."""
        every = self.here, self.at_low, self.at_high
        return 1.0 if math.isnan(self.here.optical_bit) else _spread(n.optical_bit for n in every)


def _spread(values: Iterable[float]) -> float:
    """Largest over smallest; infinite where the smallest is nothing."""
    low, *_, high = sorted(values)
    return 1.0 if low == high else high / low if low > 0.0 else math.inf


@dataclass(frozen=True, slots=True, eq=False)
class Case:
    """What the day rests on; the cases differ in one thing each. ``slower`` stretches acquisition."""

    operations: Operations
    orbits: Orbits
    data: link.DataLink
    loss: flow.PointingLoss
    slower: float = 1.0


@dataclass(frozen=True, slots=True, eq=False)
class Known:
    """What holds for every case with the same orbits and stations as the ``own`` one: contacts, passes, acquisition.

    ``weather_runs`` is how many skies are drawn for a case, and ``optical`` what its own optical downlink comes to.
    """

    own: Case
    pair_of: Callable[[Orbits], orbit.Pair]
    seen: geometry.View
    heard: tuple[flow.StationPass, ...]
    found: Found | None
    lit: tuple[OpticalPass, ...] = ()
    weather_runs: int = 1
    optical: tuple[float, float] | None = None


def numbers(case: Case, known: Known) -> Numbers:
    """Volumes and latencies of one case.

    Contacts and passes are found anew only where the case has other orbits or stations.

    Args:
        case: What the day rests on.
        known: What holds for every case with the orbits and stations of its own one.

    Raises:
        OrbitError: For orbits that do not hold.
    """
    o, own, seen, heard = case.operations, known.own.operations, known.seen, known.heard
    moved = case.orbits is not known.own.orbits
    if moved:
        seen = geometry.view(known.pair_of(case.orbits), case.data.table.wavelength_m)
    if moved or (o.downlink and own.downlink and o.downlink.stations is not own.downlink.stations):
        heard = flow.station_passes(o.downlink, seen.pair)
    rates = flow.rate_table(flow.closings(o, case.data, case.loss))
    relay = flow.relay(o, seen, rates, case.loss.outage, known.found, case.slower)
    direct = flow.direct(o, seen, heard)
    radio = (math.nan, math.nan) if direct is None else (direct.capacity_bit, direct.slow_s)
    return Numbers(relay.capacity_bit, radio[0], relay.slow_s, radio[1], *_by_optical(case, known, seen, moved))


def _by_optical(case: Case, known: Known, seen: geometry.View, moved: bool) -> tuple[float, float]:
    """Volume and slow latency of the optical downlink; those of the mission's own case where it sees no difference."""
    o, own = case.operations, known.own.operations
    if o.optical is None or own.optical is None:
        return math.nan, math.nan
    same = o.optical is own.optical and o.instrument_rate_bit_s == own.instrument_rate_bit_s and not moved
    if same and known.optical is not None:
        return known.optical
    there = not moved and o.optical.stations is own.optical.stations
    passes = known.lit if there else optical_passes(o.optical, seen.pair)
    way = optical(o.with_value("runs", known.weather_runs), seen.pair, passes)
    assert way is not None  # the mission has the table
    return way.capacity_bit, way.slow_s


def swings(known: Known, on_progress: Callable[[int, int, str], None]) -> tuple[Swing, ...]:
    """Assumptions of the day, the one that moves the ratio most first; those that move nothing stay in.

    Data rates and the time of acquisition are halved and doubled, the margin, the grazing height and the masks go to 0
    and to twice, the pointing loss to 0 and 3 dB up, the altitude a fifth down and up; attitude, eclipse, local time,
    stations and what the relay grants are replaced; the sky over the optical stations is half as often clear and free
    of clouds, its correlation none and twice, one of its stations is left out, each with the same numbers drawn. An
    orbit from a file stays as it is. A change that would leave no orbit is not made: one that decays, or lies below the
    surface that lines of sight must clear.

    Args:
        known: The mission's own case with its contacts, passes and acquisition.
        on_progress: Called with the assumptions done, their number and what is done.
    """
    o = known.own.operations
    own = replace(known.own, operations=o.with_value("runs", min(o.runs, _RUNS)))
    known = replace(known, own=own, weather_runs=min(o.runs, _SKIES))
    here = numbers(own, known)
    known = replace(known, optical=(here.optical_bit, here.optical_slow_s))

    def end(side: _Side) -> tuple[str, Numbers]:
        try:
            return (NOTHING, here) if side is None else (side[0], numbers(side[1], known))
        except orbit.OrbitError:  # the changed orbit is none
            return NOTHING, here

    made = []
    cases = list(_changes(own, known.found))
    for done, (name, *sides) in enumerate(cases):
        on_progress(done, len(cases), "each assumption changed alone")
        (low, at_low), (high, at_high) = map(end, sides)
        made.append(Swing(name, low, high, at_low, at_high, here))
    return tuple(sorted(made, key=lambda swing: -swing.factor))


_Side = tuple[str, Case] | None
_Edit = Callable[[str, str, object], tuple[str, Case]]


def _changes(own: Case, found: Found | None) -> Iterator[tuple[str, _Side, _Side]]:
    """Name, low side and high side of each assumption that the mission has."""
    o, orbits, leo, link_table = own.operations, own.orbits, own.orbits.leo, own.data.table

    def operated(text: str, key: str, value: object) -> tuple[str, Case]:
        return text, replace(own, operations=o.with_value(key, value))

    def orbiting(text: str, key: str, value: object) -> tuple[str, Case]:
        return text, replace(own, orbits=orbits.with_value(key, value))

    def sending(text: str, key: str, value: object) -> tuple[str, Case]:
        return text, replace(own, data=replace(own.data, table=link_table.with_value(key, value)))

    def scaled(
        name: str, edited: _Edit, key: str, value: float, unit: str, factors: tuple[float, float] = (0.5, 2.0)
    ) -> tuple[str, _Side, _Side]:
        low, high = (edited(format_quantity(f * value, unit, 3), key, f * value) for f in factors)
        return name, low, high

    if o.rates_bit_s is None:
        built, rate = own.data.receiver, link_table.data_rate_bit_s
        name, slow, fast = scaled("laser data rate", sending, "data_rate_bit_s", rate, "bit/s")
        yield name, slow, fast if built is None or 2.0 * rate <= built.highest_data_rate_bit_s else None
    asked = 2.0 * o.margin_db or 3.0  # every rate that just closes, and twice what is demanded
    low, high = (operated(format_quantity(end, "dB"), "margin_db", end) for end in (0.0, asked))
    yield "margin demanded of the laser link", low if o.margin_db else None, high
    none, more = replace(own.loss, loss_db=0.0), replace(own.loss, loss_db=own.loss.loss_db + 3.0)
    yield "pointing loss", ("0 dB", replace(own, loss=none)), ("3 dB more", replace(own, loss=more))
    if found is not None:
        yield "time of acquisition", ("half", replace(own, slower=0.5)), ("twice", replace(own, slower=2.0))
    if o.relay_share == 1.0:
        yield "share of each contact that the relay grants", operated("half", "relay_share", 0.5), None
    if orbits.grazing_height_m > 0.0:
        yield scaled("grazing height", orbiting, "grazing_height_m", orbits.grazing_height_m, "m", (0.0, 2.0))
    if leo.limits is None or leo.limits.attitude == "free":
        held = orbiting("nadir, 60 deg about zenith", "leo.limits", _held(leo.limits))
        yield "attitude of the satellite", held, None
    if leo.limits is not None and leo.limits.in_eclipse:
        yield "eclipse", orbiting("terminal off in it", "leo.limits.in_eclipse", False), None
    if leo.altitude_m is not None:
        yield scaled("orbit altitude", orbiting, "leo.altitude_m", leo.altitude_m, "m", (0.8, 1.2))
        if leo.local_time_s is not None:
            later = orbiting("6 h later", "leo.local_time_s", (leo.local_time_s + 21600.0) % 86400.0)
            yield "local time of the node", later, None
    yield scaled("instrument data rate", operated, "instrument_rate_bit_s", o.instrument_rate_bit_s, "bit/s")
    if o.downlink is not None:
        yield from _of_radio(o.downlink, operated, scaled)
    if o.optical is not None:
        yield from _of_optical(o.optical, operated, scaled)


_Scaled = Callable[..., tuple[str, _Side, _Side]]


def _of_radio(down: Downlink, operated: _Edit, scaled: _Scaled) -> Iterator[tuple[str, _Side, _Side]]:
    """The assumptions of the radio downlink."""
    yield scaled("radio data rate", operated, "downlink.data_rate_bit_s", down.data_rate_bit_s, "bit/s")
    given, key = down.stations, "downlink.stations"
    name, first = next(iter(given.items()))
    across = first.longitude_rad - math.copysign(math.pi, first.longitude_rad)
    opposite = first.model_copy(update={"latitude_rad": -first.latitude_rad, "longitude_rad": across})
    fewer = operated(f"without {name}", key, {n: s for n, s in given.items() if n != name}) if len(given) > 1 else None
    added = operated(f"one more, opposite {name}", key, {**given, f"opposite {name}": opposite})
    yield "ground stations", fewer, added
    masks = [
        {n: s.with_value("mask_rad", min(factor * s.mask_rad, HIGHEST_MASK_RAD)) for n, s in given.items()}
        for factor in (0.0, 2.0)
    ]
    yield "elevation mask", operated("0 deg", key, masks[0]), operated("twice", key, masks[1])


def _of_optical(down: OpticalDownlink, operated: _Edit, scaled: _Scaled) -> Iterator[tuple[str, _Side, _Side]]:
    """The assumptions of the optical downlink."""
    yield scaled("optical data rate to ground", operated, "optical.data_rate_bit_s", down.data_rate_bit_s, "bit/s")
    given, key = down.stations, "optical.stations"

    def sky(text: str, factor: float, at_least: float = 0.0) -> tuple[str, Case]:
        made = {
            n: s.with_value("availability", tuple(max(factor * a, at_least) for a in s.availability))
            for n, s in given.items()
        }
        return operated(text, key, made)

    yield "availability of the optical stations", sky("half", 0.5), sky("no clouds", 1.0, 1.0)
    if len(given) > 1:
        length = "optical.correlation_length_m"
        alone = operated("none", length, 0.0) if down.correlation_length_m else None
        twice = 2.0 * down.correlation_length_m or _CLOUDS_M
        yield "correlation length of clouds", alone, operated(format_quantity(twice, "m", 3), length, twice)
        name = next(iter(given))
        fewer = operated(f"without {name}", key, {n: s for n, s in given.items() if n != name})
        yield "optical ground stations", fewer, None
    shorter, longer = (
        operated(f"{factor * down.weather_s / 3600.0:.3g} h", "optical.weather_s", factor * down.weather_s)
        for factor in (0.5, 2.0)
    )
    yield "time that weather holds", shorter, longer


def _held(own: VisibilityLimits | None) -> VisibilityLimits:
    """The limits of a body that does not turn to its partner, with a terminal on top of it."""
    given = {"attitude": "nadir", "boresight": [0.0, 0.0, -1.0], "field_of_regard": "60 deg", "in_eclipse": True}
    held = VisibilityLimits.model_validate(given | {"slew_limit": "10 deg/s", "sun_exclusion": "0 deg"})
    if own is None:
        return held
    return own.model_copy(
        update={name: getattr(held, name) for name in ("attitude", "boresight", "field_of_regard_rad")}
    )
