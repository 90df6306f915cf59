"""Which assumption the comparison of relay and direct downlink rests on most: each one alone, changed on purpose."""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

from microrad import link, orbit
from microrad.core.units import format_quantity
from microrad.link.partner_search import Found
from microrad.mission.fields import Table
from microrad.mission.model import LinkMission
from microrad.mission.tables.orbit import HIGHEST_MASK_RAD, VisibilityLimits
from microrad.orbit.day import flow, geometry

_RUNS = 4  # of each case: what an acquisition takes is little beside what is varied
NOTHING = "as it is"

PairOf = Callable[[LinkMission], orbit.Pair]


@dataclass(frozen=True, slots=True)
class Numbers:
    """What one case comes to; nan for the direct downlink of a mission that has none."""

    relay_bit: float
    direct_bit: float
    relay_slow_s: float
    direct_slow_s: float

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
        """Largest over smallest ratio of the volumes, as it is and at both sides.

        Without a direct downlink, and where that carries nothing in any case, it is the relay's volume that counts.
        Infinite where one of them is nothing.
        """
        every = self.here, self.at_low, self.at_high
        alone = not any(n.direct_bit > 0.0 for n in every)
        low, *_, high = sorted(n.relay_bit if alone else n.ratio for n in every)
        return 1.0 if low == high else high / low if low > 0.0 else math.inf


@dataclass(frozen=True, slots=True, eq=False)
class _Case:
    """A mission that differs in one thing; ``slower`` stretches acquisition.

    ``known`` are contacts and passes of a mission, which one with the same orbits and stations shares.
    """

    mission: LinkMission
    loss: flow.PointingLoss
    known: "_Known"
    slower: float = 1.0


@dataclass(frozen=True, slots=True, eq=False)
class _Known:
    """Contacts and passes, and the mission that they are of."""

    mission: LinkMission
    seen: geometry.View
    heard: tuple[flow.Heard, ...]

    def view(self, m: LinkMission, pair_of: PairOf) -> geometry.View:
        """The contacts of a mission."""
        return self.seen if m.orbit is self.mission.orbit else geometry.view(m, pair_of(m))

    def passes(self, m: LinkMission, seen: geometry.View) -> tuple[flow.Heard, ...]:
        """The passes of a mission."""
        own, other = flow.table(self.mission).downlink, flow.table(m).downlink
        same = own is None or (other is not None and other.stations is own.stations)
        return self.heard if same and seen is self.seen else flow.heard(m, seen)


def numbers(case: _Case, pair_of: PairOf, found: Found | None) -> Numbers:
    """Volumes and latencies of one case."""
    m = case.mission
    seen = case.known.view(m, pair_of)
    rates = flow.rate_table(flow.closings(m, case.loss))
    relay = flow.relay(m, seen, rates, case.loss.outage, found, case.slower)
    direct = flow.direct(m, seen, case.known.passes(m, seen))
    none = math.nan
    return Numbers(
        relay.capacity_bit,
        none if direct is None else direct.capacity_bit,
        relay.slow_s,
        none if direct is None else direct.slow_s,
    )


def swings(
    m: LinkMission,
    pair_of: PairOf,
    seen: geometry.View,
    heard: tuple[flow.Heard, ...],
    loss: flow.PointingLoss,
    found: Found | None,
    on_progress: Callable[[int, int, str], None],
) -> tuple[Swing, ...]:
    """Assumptions of the day, the one that moves the ratio most first; those that move nothing stay in.

    Data rates and the time of acquisition are halved and doubled, the margin, the grazing height and the masks go to 0
    and to twice, the pointing loss to 0 and 3 dB up, the altitude by a fifth; attitude, eclipse, local time, stations
    and what the relay grants are replaced. An orbit from a file stays as it is, and
    so does what would leave no orbit: one that has decayed, or lies below the surface that lines of sight must clear.
    """
    m = m.with_value("operations.runs", min(flow.table(m).runs, _RUNS))
    own = _Case(m, loss, _Known(m, seen, heard))
    here = numbers(own, pair_of, found)
    made = []
    cases = list(_changes(own, found))
    for done, (name, low, high) in enumerate(cases):
        on_progress(done, len(cases), "each assumption changed alone")
        ends = [_end(side, here, pair_of, found) for side in (low, high)]
        made.append(Swing(name, ends[0][0], ends[1][0], ends[0][1], ends[1][1], here))
    return tuple(sorted(made, key=lambda swing: -swing.factor))


_Side = tuple[str, _Case] | None


def _end(side: _Side, here: Numbers, pair_of: PairOf, found: Found | None) -> tuple[str, Numbers]:
    if side is None:
        return NOTHING, here
    try:
        return side[0], numbers(side[1], pair_of, found)
    except orbit.OrbitError:  # the changed orbit is none
        return NOTHING, here


def _changes(own: _Case, found: Found | None) -> Iterator[tuple[str, _Side, _Side]]:
    """Name, low side and high side of each assumption that the mission has."""
    m = own.mission
    o, orbits = flow.table(m), m.orbit
    assert orbits is not None

    def scaled(name: str, key: str, unit: str, factors: tuple[float, float] = (0.5, 2.0)) -> tuple[str, _Side, _Side]:
        value = value_of(m, key)
        low, high = (
            (format_quantity(f * value, unit, 3), replace(own, mission=m.with_value(key, f * value))) for f in factors
        )
        return name, low, high

    def other(name: str, text: str, mission: LinkMission) -> tuple[str, _Side, _Side]:
        return name, (text, replace(own, mission=mission)), None

    if o.rates_bit_s is None:
        yield _laser_rate(own, scaled("laser data rate", "communication.data_rate_bit_s", "bit/s"))
    yield _margin(own)
    none, more = replace(own.loss, loss_db=0.0), replace(own.loss, loss_db=own.loss.loss_db + 3.0)
    yield "pointing loss", ("0 dB", replace(own, loss=none)), ("3 dB more", replace(own, loss=more))
    if found is not None:
        yield "time of acquisition", ("half", replace(own, slower=0.5)), ("twice", replace(own, slower=2.0))
    if o.relay_share == 1.0:
        yield other("share of each contact that the relay grants", "half", m.with_value("operations.relay_share", 0.5))
    if orbits.grazing_height_m > 0.0:
        yield scaled("grazing height", "orbit.grazing_height_m", "m", (0.0, 2.0))
    if orbits.leo.limits is None or orbits.leo.limits.attitude == "free":
        held = m.with_value("orbit.leo.limits", _held(orbits.leo.limits))
        yield other("attitude of the satellite", "nadir, 60 deg about zenith", held)
    if orbits.leo.limits is not None and orbits.leo.limits.in_eclipse:
        yield other("eclipse", "terminal off in it", m.with_value("orbit.leo.limits.in_eclipse", False))
    if orbits.leo.kind == "circular":
        yield scaled("orbit altitude", "orbit.leo.altitude_m", "m", (0.8, 1.2))
        if orbits.leo.local_time_s is not None:
            later = m.with_value("orbit.leo.local_time_s", (orbits.leo.local_time_s + 21600.0) % 86400.0)
            yield other("local time of the node", "6 h later", later)
    yield scaled("instrument data rate", "operations.instrument_rate_bit_s", "bit/s")
    if o.downlink is not None:
        yield scaled("radio data rate", "operations.downlink.data_rate_bit_s", "bit/s")
        yield from _stations(own)


def _held(own: VisibilityLimits | None) -> VisibilityLimits:
    """The limits of a body that does not turn to its partner, with a terminal on top of it."""
    given = {"attitude": "nadir", "boresight": [0.0, 0.0, -1.0], "field_of_regard": "60 deg", "in_eclipse": True}
    given |= {"slew_limit": "10 deg/s", "sun_exclusion": "0 deg"}
    held = VisibilityLimits.model_validate(given)
    if own is None:
        return held
    kept = {name: getattr(own, name) for name in ("slew_limit_rad_s", "sun_exclusion_rad", "in_eclipse")}
    return held.model_copy(update=kept)


def _laser_rate(own: _Case, both: tuple[str, _Side, _Side]) -> tuple[str, _Side, _Side]:
    """The laser's rates, without one that its receiver does not take."""
    built = link.receiver(own.mission)
    name, low, _ = both
    twice = 2.0 * own.mission.communication.data_rate_bit_s
    return (name, low, None) if built is not None and twice > built.highest_data_rate_bit_s else both


def _margin(own: _Case) -> tuple[str, _Side, _Side]:
    """Every rate that just closes, and twice what is demanded, or 3 dB where that is nothing."""
    asked = flow.table(own.mission).margin_db
    ends = (0.0, 2.0 * asked) if asked else (0.0, 3.0)
    low, high = (
        (format_quantity(end, "dB"), replace(own, mission=own.mission.with_value("operations.margin_db", end)))
        for end in ends
    )
    return "margin demanded of the laser link", low if asked else None, high


def _stations(own: _Case) -> Iterator[tuple[str, _Side, _Side]]:
    """More or fewer stations, and another mask for all of them."""
    m = own.mission
    assert m.operations is not None and m.operations.downlink is not None
    given = m.operations.downlink.stations
    key = "operations.downlink.stations"
    first, name = next(iter(given.values())), next(iter(given))
    across = first.longitude_rad - math.copysign(math.pi, first.longitude_rad)
    opposite = first.model_copy(update={"latitude_rad": -first.latitude_rad, "longitude_rad": across})
    fewer: _Side = None
    if len(given) > 1:
        kept = {n: s for n, s in given.items() if n != name}
        fewer = f"without {name}", replace(own, mission=m.with_value(key, kept))
    more = replace(own, mission=m.with_value(key, {**given, f"opposite {name}": opposite}))
    yield "ground stations", fewer, (f"one more, opposite {name}", more)
    masks = []
    for factor, text in ((0.0, "0 deg"), (2.0, "twice")):
        moved = {
            n: s.model_copy(update={"mask_rad": min(factor * s.mask_rad, HIGHEST_MASK_RAD)}) for n, s in given.items()
        }
        masks.append((text, replace(own, mission=m.with_value(key, moved))))
    yield "elevation mask", masks[0], masks[1]


def value_of(table: Table, key: str) -> float:
    """Value of a dotted attribute."""
    found: object = table
    for part in key.split("."):
        found = getattr(found, part)
    assert isinstance(found, float)
    return found
