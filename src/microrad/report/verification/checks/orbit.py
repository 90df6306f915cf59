"""Checks of the day: the shipped orbit propagated and searched anew, volumes and latency by a queue in seconds."""

import itertools
import math
from collections.abc import Callable, Iterator
from datetime import datetime

import numpy as np
from numpy.typing import NDArray

from microrad.report.verification.check import Check
from microrad.report.verification.evidence import Comparison, Referent
from microrad.report.verification.workspace import Given, Workspace

Floats = NDArray[np.float64]

_MU, _J2, _RE_M, _POLE_M = 3.986004418e14, 1.08262668e-3, 6378137.0, 6356752.314245
_TURN, _LIGHT_M_S = 2.0 * math.pi / 86164.0905, 299792458.0
_GEO_M = (_MU / _TURN**2) ** (1.0 / 3.0)
_MODELS_S = 3.0
"""Between two places of a low satellite: the mean Sun and the turn of the Earth are known to some arcseconds in any
textbook, 0.1 s of the orbit; searched from samples 2 s apart, by a straight line between them, at a grazing angle."""
_WHY = "3 s: mean Sun, turn of the Earth, straight lines between samples of 2 s"


class _Day:
    """Places of the shipped satellites and station in an inertial frame, sampled every 2 s."""

    def __init__(self, given: Given, days: float = 1.0) -> None:
        """Of the mission's values, for so many times its duration."""
        epoch = datetime.fromisoformat(given("orbit.epoch"))
        since = (epoch - datetime.fromisoformat("2000-01-01T12:00:00Z")).total_seconds() / 86400.0
        sun_deg = 280.46646 + 0.98564736 * since
        sidereal = math.radians(280.46061837 + 360.98564736629 * since)
        self.step_s = 2.0
        self.time_s = np.arange(0.0, days * given("orbit.duration") + self.step_s, self.step_s)
        a = _RE_M + given("orbit.leo.altitude")
        n = math.sqrt(_MU / a**3)
        flat = 1.5 * _J2 * (_RE_M / a) ** 2 * n
        tilt = math.acos(-2.0 * math.pi / (365.2421897 * 86400.0) / flat)
        node = math.radians(sun_deg) + (given("orbit.leo.local_time") / 3600.0 - 12.0) * math.pi / 12.0
        node = node - flat * math.cos(tilt) * self.time_s
        along = (n + flat * (1.0 - 1.5 * math.sin(tilt) ** 2) + flat * (2.0 - 2.5 * math.sin(tilt) ** 2)) * self.time_s
        self.leo = a * np.stack(
            [
                np.cos(node) * np.cos(along) - np.sin(node) * np.sin(along) * math.cos(tilt),
                np.sin(node) * np.cos(along) + np.cos(node) * np.sin(along) * math.cos(tilt),
                np.sin(along) * math.sin(tilt),
            ]
        )
        turned = sidereal + _TURN * self.time_s
        east = turned + given("orbit.geo.longitude")
        self.geo = _GEO_M * np.stack([np.cos(east), np.sin(east), np.zeros_like(east)])
        now = since + self.time_s / 86400.0
        anomaly = np.radians(357.52911 + 0.98560028 * now)
        longitude = np.radians(
            280.46646 + 0.98564736 * now + 1.914602 * np.sin(anomaly) + 0.019993 * np.sin(2 * anomaly)
        )
        slant = math.radians(23.43929)
        self.sun = np.stack(
            [np.cos(longitude), np.sin(longitude) * math.cos(slant), np.sin(longitude) * math.sin(slant)]
        )
        self.turned = turned

    def elevation(self, given: Given, name: str) -> Floats:
        """Of the satellite above the horizon of a ground station."""
        table = f"operations.downlink.stations.{name}"
        latitude, height_m = given(f"{table}.latitude"), given(f"{table}.height")
        east = self.turned + given(f"{table}.longitude")
        e2 = 1.0 - (_POLE_M / _RE_M) ** 2
        curve_m = _RE_M / math.sqrt(1.0 - e2 * math.sin(latitude) ** 2)
        up = np.stack(
            [
                math.cos(latitude) * np.cos(east),
                math.cos(latitude) * np.sin(east),
                np.full_like(east, math.sin(latitude)),
            ]
        )
        scale = np.array([[curve_m + height_m], [curve_m + height_m], [curve_m * (1.0 - e2) + height_m]])
        sight = self.leo - scale * up
        return np.asarray(np.arcsin(np.sum(sight * up, axis=0) / np.linalg.norm(sight, axis=0)))

    def spans(self, room: Floats) -> list[tuple[float, float]]:
        """Begins and ends of the times at which a quantity is above zero, by straight lines between the samples."""
        above = room > 0.0
        places = np.flatnonzero(above[1:] != above[:-1])
        share = room[places] / (room[places] - room[places + 1])
        turns = list(self.time_s[places] + share * self.step_s)
        if above[0]:
            turns.insert(0, 0.0)
        if above[-1]:
            turns.append(float(self.time_s[-1]))
        return list(zip(turns[::2], turns[1::2], strict=True))


def _relay_room(day: _Day, given: Given) -> Floats:
    """How far the line of sight is from the nearest of its limits, below zero where it is beyond."""
    sight = day.leo - day.geo
    length = np.linalg.norm(sight, axis=0)
    # the ellipsoid with the grazing height on it becomes a sphere by a scale along the pole
    high = given("orbit.grazing_height")
    scale = np.array([[1.0], [1.0], [(_RE_M + high) / (_POLE_M + high)]])
    start, way = scale * day.leo, scale * (day.geo - day.leo)
    place = np.clip(-np.sum(start * way, axis=0) / np.sum(way * way, axis=0), 0.0, 1.0)
    room = np.linalg.norm(start + place * way, axis=0) / (_RE_M + high) - 1.0
    exclusion = given("orbit.leo.limits.sun_exclusion")
    toward = -sight / length
    for place, looks in ((day.leo, toward), (day.geo, -toward)):
        from_sun = np.arccos(np.clip(np.sum(looks * day.sun, axis=0), -1.0, 1.0)) - exclusion
        along = np.sum(place * day.sun, axis=0)
        shaded = (along < 0.0) & (np.linalg.norm(place - along * day.sun, axis=0) < _RE_M)
        room = np.minimum(room, np.where(shaded, math.pi, from_sun))
    return np.asarray(room)


def relay_spans(given: Given) -> list[tuple[float, float]]:
    """Begins and ends (s) of the contacts with the relay, searched anew.

    Args:
        given: The mission's values.
    """
    day = _Day(given)
    return day.spans(_relay_room(day, given))


def _contacts(workspace: Workspace) -> Iterator[Comparison]:
    given, day = workspace.given, _Day(workspace.given)
    spans = day.spans(_relay_room(day, given))
    waits = workspace.numbers("budget")["acquisition.ways.wide beacon.mean_time_s"]

    def compared(name: str, expected: float, tolerance: float, why: str = _WHY) -> Comparison:
        return workspace.compared("run", f"day.{name}", expected, tolerance, why)

    yield compared("relay.contacts", len(spans), 0.0, "a count")
    sight = day.geo - day.leo
    length = np.linalg.norm(sight, axis=0)
    speed = np.gradient(sight, day.step_s, axis=1)
    closing = np.sum(speed * sight, axis=0) / length
    across = np.linalg.norm(speed - closing * sight / length, axis=0)
    turning = np.linalg.norm(np.gradient(np.cross(sight / length, speed / length, axis=0), day.step_s, axis=1), axis=0)
    found: dict[str, Callable[[slice], float]] = {
        "range_least_m": lambda part: float(length[part].min()),
        "range_most_m": lambda part: float(length[part].max()),
        "point_ahead_most_rad": lambda part: 2.0 * float(across[part].max()) / _LIGHT_M_S,
        "line_of_sight_rate_most_rad_s": lambda part: float((across / length)[part].max()),
        "line_of_sight_acceleration_most_rad_s2": lambda part: float(np.abs(turning[part]).max()),
        "range_rate_most_m_s": lambda part: float(np.abs(closing[part]).max()),
        "doppler_most_hz": lambda part: float(np.abs(closing[part]).max()) / given("communication.wavelength"),
    }
    for place, (begin, end) in enumerate(spans):
        yield compared(f"contacts.{place}.start_s", begin, _MODELS_S)
        yield compared(f"contacts.{place}.end_s", end, _MODELS_S)
        yield compared(f"contacts.{place}.duration_s", end - begin, _MODELS_S)
        part = slice(math.ceil(begin / day.step_s), math.floor(end / day.step_s) + 1)
        for key, of in found.items():
            expected = of(part)
            yield compared(
                f"contacts.{place}.{key}", expected, 5e-3 * expected, "0.5 %: 3 s at the ends, J2 in the motion"
            )
        carried = given("communication.data_rate") * (end - begin - waits)
        yield compared(
            f"contacts.{place}.could_carry_bit", carried, 3e-3 * carried, "0.3 %: 3 s of a contact, drawn acquisitions"
        )
    lengths = [end - begin for begin, end in spans]
    whole = given("orbit.duration")
    yield compared("relay.contact_s", sum(lengths), 30.0, "30 s: 15 contacts")
    yield compared("visible_share", sum(lengths) / whole, 30.0 / whole, "30 s of a day")
    uncut = [end - begin for begin, end in spans if begin > 0.0 and end < whole]
    yield compared("median_contact_s", float(np.median(uncut)), _MODELS_S)
    gaps = [b[0] - a[1] for a, b in itertools.pairwise(spans)]
    gaps += [spans[0][0], whole - spans[-1][1]]
    yield compared("relay.longest_gap_s", max(gaps), 2.0 * _MODELS_S)
    grazing = _RE_M + given("orbit.grazing_height")
    low, high = _RE_M + given("orbit.leo.altitude"), _GEO_M
    relative = math.sqrt(_MU / low**3) - _TURN
    closed = 2.0 * (math.acos(grazing / low) + math.acos(grazing / high)) / relative
    yield compared("closed_form_contact_s", closed, 1e-3 * closed, "0.1 %: with or without the Earth's flattening")


def _passes(workspace: Workspace) -> Iterator[Comparison]:
    given, day = workspace.given, _Day(workspace.given)
    elevation = day.elevation(given, "kiruna")
    spans = day.spans(elevation - given("operations.downlink.stations.kiruna.mask"))
    yield workspace.compared("run", "day.direct.contacts", len(spans), 0.0, "a count")
    for k, (begin, end) in enumerate(spans):
        name = f"day.direct.passes.{k}"
        yield workspace.compared("run", f"{name}.start_s", begin, _MODELS_S, _WHY)
        yield workspace.compared("run", f"{name}.end_s", end, _MODELS_S, _WHY)
        yield workspace.compared("run", f"{name}.duration_s", end - begin, _MODELS_S, _WHY)
        part = slice(math.ceil(begin / day.step_s), math.floor(end / day.step_s) + 1)
        highest = float(elevation[part].max())
        yield workspace.compared(
            "run", f"{name}.highest_elevation_rad", highest, 5e-3, "5 mrad: 3 s of a pass overhead"
        )
        carried = given("operations.downlink.data_rate") * max(0.0, end - begin - given("operations.downlink.setup"))
        why = "3 s of a pass at its rate"
        yield workspace.compared("run", f"{name}.could_carry_bit", carried, 3e8, why)
    lengths = [end - begin for begin, end in spans]
    yield workspace.compared("run", "day.direct.contact_s", sum(lengths), 20.0, "20 s: ten passes")
    total = given("operations.downlink.data_rate") * (sum(lengths) - len(spans) * given("operations.downlink.setup"))
    yield workspace.compared("run", "day.direct.could_carry_bit", total, 2e9, "20 s at the downlink's rate")


def _queue(workspace: Workspace) -> Iterator[Comparison]:
    """What an instrument makes in a day, through the contacts of that day and of the next, first in, first out."""
    given, day = workspace.given, _Day(workspace.given, 2.0)
    waits = workspace.numbers("budget")["acquisition.ways.wide beacon.mean_time_s"]
    down = "operations.downlink"
    risen = day.elevation(given, "kiruna") - given(f"{down}.stations.kiruna.mask")
    ways = {
        "relay": (_relay_room(day, given), given("communication.data_rate"), waits, given("operations.relay_delay")),
        "direct": (risen, given(f"{down}.data_rate"), given(f"{down}.setup"), given(f"{down}.delay")),
    }
    duration_s, rate_in, step_s = given("orbit.duration"), given("operations.instrument_rate"), 0.5
    count = int(duration_s / step_s)
    generated = rate_in * step_s * np.minimum(np.arange(1, 2 * count + 1), count)
    for way, (room, rate, setup_s, delay_s) in ways.items():
        sends = np.zeros(2 * count)
        for begin, end in day.spans(room):
            sends[math.ceil((begin + setup_s) / step_s) : math.floor(end / step_s)] = rate * step_s
        delivered, total = np.empty(2 * count), 0.0
        for k, each in enumerate(sends):
            total = min(total + each, float(generated[k]))
            delivered[k] = total
        arrives = np.searchsorted(delivered, generated[:count] - 1.0)
        latency = step_s * (arrives - np.arange(count)) + delay_s
        middle, slow = float(np.median(latency)), float(np.quantile(latency, 0.99))
        why = "10 s and 0.3 %: contacts begin up to 3 s apart, acquisitions are drawn"
        name = f"day.{way}"
        yield workspace.compared("run", f"{name}.latency_median_s", middle, 10.0 + 3e-3 * middle, why)
        yield workspace.compared("run", f"{name}.latency_99_percent_s", slow, 10.0 + 3e-3 * slow, why)
        made = rate_in * duration_s
        for key, expected in (("generated_bit", made), ("arrived_bit", delivered[-1]), ("lost_bit", 0.0)):
            yield workspace.compared(
                "run", f"{name}.{key}", float(expected), 1e-6 * made, "a millionth of the day's data"
            )
        left = made - float(delivered[-1])
        yield workspace.compared(
            "run", f"{name}.on_board_at_end_bit", left, 1e-6 * made, "a millionth of the day's data"
        )


CHECKS = (
    Check(
        "contacts",
        "Contacts of the shipped satellite with its relay, propagated and searched anew",
        Referent.INDEPENDENT,
        "A circular orbit with the secular drift of J2, the grazing line over the ellipsoid and the Sun, every 2 s.",
        "WGS 84; Vallado, Fundamentals of Astrodynamics, for the mean Sun and J2",
        _contacts,
    ),
    Check(
        "passes",
        "Passes over the shipped ground station",
        Referent.INDEPENDENT,
        "As the contacts; elevation above the ellipsoid's horizon.",
        "WGS 84",
        _passes,
    ),
    Check(
        "queue",
        "Volumes and latency by a queue, half a second at a time",
        Referent.INDEPENDENT,
        "First in, first out, through contacts that are searched anew; the next day delivers what the first has left.",
        "conservation of data",
        _queue,
    ),
)
