"""The figures of a day: from its study to what is drawn."""

from itertools import pairwise

import numpy as np

from microrad import orbit
from microrad.core.arrays import Floats
from microrad.orbit.day import NOTHING, DayStudy, Swing, Way, times
from microrad.orbit.day.ground_track import LONGEST_S, Outline, ground_track
from microrad.report import day_assumptions, day_figures, day_map
from microrad.report.plotting.figure import Figure
from microrad.study.contact_run import ContactRun

_SHARES = 400  # points of a distribution
_BEFORE = 1e-9  # part of a latency by which a jump of the distribution is looked at before it


def draw(day: DayStudy, run: ContactRun | None = None) -> tuple[Figure, ...]:
    """Every figure of a day; ``run`` is one of its contacts, simulated."""
    found = [_timeline(day), *_along(day), _volume(day), _latency(day), ground_map(day), _assumptions(day)]
    return tuple(found if run is None else [*found, _run(day, run)])


def _ways(day: DayStudy) -> tuple[Way, ...]:
    return (day.relay,) if day.direct is None else (day.relay, day.direct)


def _timeline(day: DayStudy) -> Figure:
    span = day.view.pair.span_s
    rows = [(day.relay.name, _bars(day.relay.contacts, span[1]))]
    if day.direct is not None:
        for station in dict.fromkeys(day.direct.stations):
            own = tuple(c for c, s in zip(day.direct.contacts, day.direct.stations, strict=True) if s == station)
            rows.append((f"direct: {station}", _bars(own, span[1])))
    rows.append((f"eclipse of {day.view.pair.leo.name}", day.view.umbra_s))
    return day_figures.timeline(rows, span, day.view.pair.epoch.text)


def _bars(contacts: tuple[orbit.Contact, ...], end_s: float) -> Floats:
    return np.array([(c.start_s, min(c.end_s, end_s)) for c in contacts]).reshape(-1, 2)


def _along(day: DayStudy) -> list[Figure]:
    """The contact that the mission looks at in time, the first where it names none."""
    if not day.view.encounters:
        return []
    o, found = day.operations, day.view.encounters
    number = 1 if o is None or o.contact is None else o.contact.number
    contact, pair = found[number - 1].contact, day.view.pair
    seen = orbit.sight(pair.leo.orbit, pair.geo.orbit, times(contact))
    doppler = seen.doppler_hz(day.data.table.wavelength_m)
    since_s = seen.time_s - contact.start_s
    rise = pair.epoch.utc(contact.start_s)[:19].replace("T", " ")
    return [
        day_figures.along_contact(
            since_s,
            seen.range_m,
            seen.point_ahead_rad,
            seen.rate_rad_s,
            doppler,
            number=number,
            rise_utc=rise,
        )
    ]


def _volume(day: DayStudy) -> Figure:
    history = day.relay.history
    cumulative = {"made by the instrument": (history.time_s, history.generated_bit)}
    stored = {}
    for way in _ways(day):
        cumulative[way.name] = way.history.time_s, way.history.delivered_bit
        stored[way.name] = way.history.time_s, way.history.stored_bit
    return day_figures.volume(cumulative, stored)


def _latency(day: DayStudy) -> Figure:
    return day_figures.latency({way.name: _distribution(way) for way in _ways(day)})


def _distribution(way: Way) -> tuple[Floats, Floats]:
    """Latency and the share of the data that arrived within it: on both sides of each bend, and evenly between."""
    bends = np.unique(np.concatenate((way.latency.first_s, way.latency.last_s)))
    if not bends.size:
        return bends, bends
    bends = bends[:: max(bends.size // _SHARES, 1)]
    even = np.linspace(bends[0], bends[-1], _SHARES)
    latency_s = np.unique(np.concatenate((bends, bends * (1.0 - _BEFORE), even)))
    return latency_s, way.latency.cdf(latency_s)


def ground_map(day: DayStudy) -> Figure:
    """The world with the ground track, the relay and the stations."""
    o = day.operations
    track = ground_track(day.view, _ways(day), None if o is None else o.downlink)
    places = day_map.Places(track.latitude_rad, track.longitude_rad)
    relay, stations = dict([_marked(track.relay)]), dict(_marked(station) for station in track.stations)
    first_s = LONGEST_S if day.view.duration_s > LONGEST_S else None
    return day_map.world_map(places, track.open, relay, stations, first_s)


def _marked(each: Outline) -> tuple[str, day_map.Marked]:
    place = day_map.Places(each.latitude_rad, each.longitude_rad)
    return each.name, day_map.Marked(place, day_map.Places(each.around_latitude_rad, each.around_longitude_rad))


def _assumptions(day: DayStudy) -> Figure:
    """The bars stand in the order of `Swing.factor`, as the words about them do."""
    direct = day.direct is not None
    bars = [
        day_assumptions.Assumed(
            _label(s),
            s.at_low.ratio if direct else s.at_low.relay_bit / 8e12,
            s.at_high.ratio if direct else s.at_high.relay_bit / 8e12,
        )
        for s in day.swings
    ]
    if direct:
        return day_assumptions.assumptions(bars, day.ratio, "volume by relay over volume direct")
    return day_assumptions.assumptions(bars, day.relay.capacity_bit / 8e12, "volume by the relay (TB)")


def _label(swing: Swing) -> str:
    """The assumption and what it is changed to."""
    changed = [side for side in (swing.low, swing.high) if side != NOTHING]
    return f"{swing.name}: {' / '.join(changed)}" if changed else swing.name


def _run(day: DayStudy, run: ContactRun) -> Figure:
    begin = run.contact.start_s
    states = [(a.to, a.time_s - begin, b.time_s - begin) for a, b in pairwise(run.log) if b.time_s > a.time_s]
    windows = day_figures.Windows(
        np.array([w.start_s + w.seconds / 2.0 - begin for w in run.windows]),
        np.array([w.rms_rad for w in run.windows]),
        np.array([w.largest_rad for w in run.windows]),
    )
    return day_figures.contact_run(states, windows, day.data.requirement.pointing_error_rad)
