"""When two terminals can see each other, and a ground station a satellite; and what begins and ends each contact."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from microrad.orbit.base import Floats, Orbit, OrbitError, States
from microrad.orbit.earth import MU_M3_S2, Earth
from microrad.orbit.epoch import Epoch
from microrad.orbit.events import Intervals, Rows, intersection, largest, positive, positive_rows
from microrad.orbit.ground import Station, elevation_rad
from microrad.orbit.limits import Condition, Side, Terminal, conditions
from microrad.orbit.line_of_sight import dot

Span = tuple[float, float]

START, END = "start of the span", "end of the span"
EARTH = "Earth"
RANGE = "range"

_STEPS_PER_TURN = 85.0  # 60 s for every orbit with its perigee above 100 km
_MOST_SAMPLES = 5_000_000


# ------------------------------------------------------------------------------------------------------------ contacts
@dataclass(frozen=True, slots=True)
class Contact:
    """One contact, in seconds after the epoch, and what begins and ends it, in words; two at once joined by "and"."""

    start_s: float
    end_s: float
    begins: str
    ends: str

    @property
    def duration_s(self) -> float:
        """How long it takes."""
        return self.end_s - self.start_s


@dataclass(frozen=True, slots=True)
class Pass(Contact):
    """A contact with a ground station, with its largest elevation and when that is."""

    highest_rad: float
    highest_s: float


# ---------------------------------------------------------------------------------------------------------- the samples
def coarse_step_s(orbit: Orbit, time_s: float) -> float:
    """Step in which an orbit is sampled: 60 s times a power of two, at most an 85th of a turn at its perigee's rate.

    The perigee is that of the ellipse through the state at `time_s`: with the angular momentum h its radius is
    h^2 / (mu (1 + e)), and its rate h over that squared. Every low orbit has 60 s, so that samples can be shared.

    Raises `OrbitError` for a state that falls straight to the Earth's centre.
    """
    position, velocity = (vector[:, 0] for vector in orbit.states(np.array([time_s])))
    with np.errstate(over="ignore", invalid="ignore"):  # of a state that is none
        momentum = np.cross(position, velocity)
        eccentricity = np.linalg.norm(np.cross(velocity, momentum) / MU_M3_S2 - position / np.linalg.norm(position))
        square = float(momentum @ momentum)
        perigee = square / (MU_M3_S2 * (1.0 + float(eccentricity)))
        longest = 2.0 * math.pi * perigee**2 / math.sqrt(square) / _STEPS_PER_TURN if square > 0.0 else 0.0
    if not 0.0 < longest < math.inf:
        raise OrbitError(
            f"{orbit.name}: the state at {time_s:g} s moves straight to or from the Earth's centre, or is no number; "
            "check its velocity"
        )
    return 60.0 * 2.0 ** math.floor(math.log2(longest / 60.0))


def coarse_times(span_s: Span, step_s: float) -> Floats:
    """Samples over the span, both ends among them, evenly, at most `step_s` apart and at least five.

    Raises `OrbitError` for a span that does not end after its start, and for one of more than 5 million steps.
    """
    start, end = span_s
    if not (math.isfinite(start) and math.isfinite(end) and start < end):
        raise OrbitError(f"the span from {start:g} s to {end:g} s holds no time; give a start and a later end")
    if not (end - start) / step_s <= _MOST_SAMPLES:
        raise OrbitError(
            f"the span from {start:g} s to {end:g} s would be searched in steps of {step_s:.3g} s, more than "
            f"{_MOST_SAMPLES:.0e} of them; give a shorter span, or check the velocities of the orbits"
        )
    return np.linspace(start, end, max(math.ceil((end - start) / step_s), 4) + 1)


@dataclass(frozen=True, slots=True, eq=False)
class Sampled:
    """The states of an orbit at the samples of a span, for use with many partners; `step_s` is its own coarse step."""

    orbit: Orbit
    step_s: float
    time_s: Floats
    states: States

    @classmethod
    def over(cls, orbit: Orbit, span_s: Span, step_s: float = math.inf) -> "Sampled":
        """Sampled in its own coarse step, or in `step_s` where that is finer (that of a faster partner)."""
        own = coarse_step_s(orbit, span_s[0])
        time_s = coarse_times(span_s, min(own, step_s))
        return cls(orbit, own, time_s, orbit.states(time_s))

    def at(self, time_s: Floats) -> States:
        """The states at these samples, kept ones if they are the same."""
        return self.states if np.array_equal(time_s, self.time_s) else self.orbit.states(time_s)


# ------------------------------------------------------------------------------------------------------------- contacts
def contacts(first: Terminal, second: Terminal, earth: Earth, epoch: Epoch, span_s: Span) -> tuple[Contact, ...]:
    """The contacts of two terminals in the span (start, end), in order; the ends as exact as the orbits, to 1e-6 s.

    The same to the last bit when the two are swapped. Light time (0.15 s over 44 000 km) is left out; the ends may move
    by as much.

    Raises `OrbitError` for two terminals of one name, a span that is none, two orbits that meet, a terminal below the
    surface that the line of sight must clear, and what the orbits raise.
    """
    return contacts_with_each(first, (second,), earth, epoch, span_s)[0]


def contacts_with_each(
    satellite: Terminal,
    relays: Sequence[Terminal],
    earth: Earth,
    epoch: Epoch,
    span_s: Span,
    sampled: Sequence[Sampled] = (),
    furthest_m: float = math.inf,
) -> tuple[tuple[Contact, ...], ...]:
    """`contacts` of a satellite with each of the relays, solved together, up to a range of `furthest_m`.

    `sampled`, one for each relay, saves to compute their states anew for every satellite:
    ``Sampled.over(relay.orbit, span_s, coarse_step_s(satellite.orbit, span_s[0]))``; samples in another step are left
    aside. Limits that are not set cost nothing.

    Raises `OrbitError` as `contacts`.
    """
    _check_names(satellite, relays)
    own = coarse_step_s(satellite.orbit, span_s[0])
    others = tuple(sampled) or tuple(Sampled.over(relay.orbit, span_s, own) for relay in relays)
    time_s = coarse_times(span_s, min(own, *(other.step_s for other in others), math.inf))
    clear = _clear_of_earth((satellite, *relays), others, earth, time_s)
    near = _in_reach(satellite.orbit, others, furthest_m, time_s)
    found = []
    for place, relay in enumerate(relays):
        kept = [(EARTH, clear[place]), *((RANGE, each[place]) for each in near)]
        for one, other in ((satellite, relay), (relay, satellite)):
            kept.extend(conditions(Side(one, other, earth, epoch), time_s))
        found.append(_combined(kept, span_s))
    return tuple(found)


def _check_names(satellite: Terminal, relays: Sequence[Terminal]) -> None:
    for relay in relays:
        if relay.name == satellite.name:
            raise OrbitError(f'two terminals are called "{relay.name}"; give each a name of its own')


def _clear_of_earth(
    terminals: Sequence[Terminal], others: Sequence[Sampled], earth: Earth, time_s: Floats
) -> tuple[Intervals, ...]:
    """When the Earth is not in the way from the first of the terminals to each of the others."""
    if not others:
        return ()
    orbit = terminals[0].orbit

    def checked(time: Floats, row: Rows, first: Floats, second: Floats) -> Floats:
        try:
            return earth.clearance_rad(first, second)
        except OrbitError:
            heights = np.stack((earth.height_m(first), earth.height_m(second)))
            which, worst = np.unravel_index(np.argmin(heights), heights.shape)  # argmin finds nan first
            low = terminals[0 if which == 0 else row[worst] + 1]
            raise _too_low(low.name, float(time[worst]), float(heights[which, worst]), earth) from None

    def clearance(time: Floats, row: Rows) -> Floats:
        return checked(time, row, *_places(orbit, others, time, row))

    first = orbit.states(time_s).position_m
    values = np.empty((len(others), time_s.size))
    for index, other in enumerate(others):
        values[index] = checked(time_s, np.full(time_s.size, index), first, other.at(time_s).position_m)
    return positive_rows(clearance, time_s, values)


def _places(orbit: Orbit, others: Sequence[Sampled], time: Floats, row: Rows) -> tuple[Floats, Floats]:
    """Where an orbit is at each time, and where the other of that row is."""
    first = orbit.states(time).position_m
    second = np.empty_like(first)
    for index in np.unique(row):
        chosen = row == index
        second[:, chosen] = others[index].orbit.states(time[chosen]).position_m
    return first, second


def _in_reach(
    orbit: Orbit, others: Sequence[Sampled], furthest_m: float, time_s: Floats
) -> tuple[tuple[Intervals, ...], ...]:
    """When each of the others is nearer than the limit: one set of intervals for each, or none without a limit."""
    if furthest_m == math.inf or not others:
        return ()
    if furthest_m <= 0.0:  # the link closes nowhere
        return ((np.empty((0, 2)),) * len(others),)

    def spare(first: Floats, second: Floats) -> Floats:
        apart = second - first
        return np.asarray(1.0 - dot(apart, apart) / furthest_m**2)

    first = orbit.states(time_s).position_m
    values = np.stack([spare(first, other.at(time_s).position_m) for other in others])
    return (positive_rows(lambda time, row: spare(*_places(orbit, others, time, row)), time_s, values),)


def _too_low(name: str, time_s: float, height_m: float, earth: Earth) -> OrbitError:
    if math.isnan(height_m):
        return OrbitError(f"the position of {name} at {time_s:.9g} s is not a number; check its orbit")
    return OrbitError(
        f"{name} is {height_m / 1e3:.3f} km over the Earth at {time_s:.9g} s, not above the "
        f"{earth.grazing_height_m / 1e3:.6g} km that lines of sight must clear; lower orbit.grazing_height, or raise "
        "the orbit"
    )


def _combined(kept: Sequence[Condition], span_s: Span) -> tuple[Contact, ...]:
    """The contacts in which all conditions hold."""
    both = intersection(*(intervals for _, intervals in kept))
    return tuple(
        Contact(
            float(start),
            float(end),
            START if start == span_s[0] else _causes(kept, start, 0),
            END if end == span_s[1] else _causes(kept, end, 1),
        )
        for start, end in both
    )


def _causes(kept: Sequence[Condition], time_s: float, edge: int) -> str:
    return " and ".join(sorted(cause for cause, intervals in kept if np.any(intervals[:, edge] == time_s)))


# --------------------------------------------------------------------------------------------------------------- passes
def passes(orbit: Orbit, station: Station, epoch: Epoch, span_s: Span) -> tuple[Pass, ...]:
    """The passes of a satellite over a ground station in the span: its elevation, geometric, is above the mask.

    Raises `OrbitError` for a span that is none, and what the orbit raises.
    """
    step = coarse_step_s(orbit, span_s[0])
    time_s = coarse_times(span_s, step)
    mask = f"elevation mask of {station.name}"

    def elevation(time: Floats) -> Floats:
        return elevation_rad(station, epoch, time, orbit.states(time).position_m)

    windows = positive(lambda time: elevation(time) - station.mask_rad, time_s)
    return tuple(
        Pass(
            float(start),
            float(end),
            START if start == span_s[0] else mask,
            END if end == span_s[1] else mask,
            float(highest),
            float(when),
        )
        for (start, end), when, highest in zip(windows, *largest(elevation, windows, step), strict=True)
    )
