"""Figures of a day in orbit: contacts, what one of them asks of the terminals, data and delay."""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from microrad import orbit
from microrad.core.arrays import Floats
from microrad.orbit.day import NOTHING, DayStudy, Swing, Way, times
from microrad.orbit.day.ground_track import LONGEST_S, Outline, ground_track
from microrad.report.day.world_map import Marked, Places, world_map
from microrad.report.plotting.figure import Figure
from microrad.report.plotting.palette import BLACK, BLUE, GREEN, GREY, ORANGE, SKY, VERMILION
from microrad.report.plotting.sheet import (
    WIDTH,
    Bars,
    Dash,
    Legend,
    Line,
    Panel,
    Rule,
    Sheet,
    Words,
    empty,
    grid,
    shortened,
)
from microrad.report.plotting.sheet import rows as named_rows
from microrad.report.plotting.swings import in_lines, swing_bars, swing_legend
from microrad.report.quantities import duration, plain
from microrad.study.contact_run import ContactRun

Curves = Mapping[str, tuple[Floats, Floats]]  # name: abscissa (n,), ordinate (n,)

_COLOURS = (BLUE, ORANGE, GREEN, SKY, VERMILION, GREY)
_DASHES = ("-", "--", "-.", ":")
_NONE = np.empty(0)
_STATES = {"data": BLUE, "loss": VERMILION}  # the other states take the colours that are left
_UNITS_S = {"ms": 1e-3, "s": 1.0, "min": 60.0, "h": 3600.0, "d": 86400.0}
_WIDE = {"ms": (1, 10), "s": (0.1, 1, 10), "min": (1, 10), "h": (1, 6), "d": (1, 7, 30)}
_DENSE = {"ms": (1, 2, 5, 10, 20, 50, 100, 200, 500), "s": (1, 2, 5, 10, 20, 30), "min": (1, 2, 5, 10, 20, 30)}
_DENSE |= {"h": (1, 2, 3, 6, 12), "d": (1, 2, 4, 7, 14, 30, 60, 120, 240)}
_HOURS = (0.1, 0.25, 0.5, 1.0, 2.0, 3.0, 4.0, 6.0, 12.0, 24.0, 48.0, 96.0, 168.0)
_SHARES = 400  # points of a distribution
_BEFORE = 1e-9  # part of a latency by which a jump of the distribution is looked at before it
MOST_BARS = 14


class Windows(NamedTuple):
    """Radial pointing error in the sampled windows of a contact, each (n,): middle (s), rms (rad), largest (rad)."""

    time_s: Floats
    rms_rad: Floats
    largest_rad: Floats


# ------------------------------------------------------------------------------------------------ bars over time


def timeline(rows: Sequence[tuple[str, Floats]], span_s: tuple[float, float], epoch_label: str) -> Figure:
    """Intervals, one row for each name. Beside each row: how many, and their sum.

    Args:
        rows: name and array (n, 2) of begins and ends, in seconds since the epoch; names that agree up to a colon
            ("direct: Kiruna") have one colour.
        span_s: begin and end of the axis, in seconds since the epoch.
        epoch_label: how the epoch is written.
    """
    sheet = _timeline(rows, span_s, epoch_label) if rows else empty("no contacts and no eclipses to show")
    caption = (
        f"From {span_s[0] / 3600.0:g} h to {span_s[1] / 3600.0:g} h after {epoch_label}. "
        "At the right of each row: how many intervals, and how long they are together."
    )
    columns = {} if rows else {"start (s)": _NONE, "end (s)": _NONE}
    for name, intervals in rows:
        columns[f"{name}, start (s)"], columns[f"{name}, end (s)"] = np.reshape(intervals, (-1, 2)).T
    return Figure("day-timeline", "Contacts over time", caption, sheet, columns)


def _timeline(rows: Sequence[tuple[str, Floats]], span_s: tuple[float, float], epoch_label: str) -> Sheet:
    sheet, (panel,) = grid(WIDTH, 0.8 + 0.27 * len(rows))
    kinds = [*dict.fromkeys(name.split(":")[0] for name, _ in rows)]
    _bars(panel, rows, [_COLOURS[kinds.index(name.split(":")[0]) % len(_COLOURS)] for name, _ in rows], 3600.0)
    panel.x.ticks, panel.x.title = _hours(*span_s).tolist(), f"hours since {epoch_label}"
    panel.x.low, panel.x.high = span_s[0] / 3600.0, span_s[1] / 3600.0
    return sheet


def _bars(panel: Panel, rows: Sequence[tuple[str, Floats]], colours: Sequence[str], unit_s: float) -> None:
    """A row of bars for each name, the first on top; a bar too short to see keeps the width of its edge."""
    for row, ((_, intervals), colour) in enumerate(zip(rows, colours, strict=True)):
        start_s, end_s = np.reshape(intervals, (-1, 2)).T
        at, breadth = np.full(start_s.shape, float(row)), np.full(start_s.shape, 0.68)
        panel.add(Bars(at, start_s / unit_s, end_s / unit_s, breadth, colour, edge=colour))
        words = f"{start_s.size} · {duration(float(np.sum(end_s - start_s)))}" if start_s.size else "none"
        ink = BLACK if start_s.size else GREY
        panel.add(Words(words, 1.0, row, ink, 9.0, shift=(5.0, 0.0), of_panel="x"))
    panel.y = named_rows([shortened(name) for name, _ in rows], 9.0)


def _hours(start_s: float, end_s: float) -> Floats:
    """Round hours over the span, about ten of them."""
    first, last = start_s / 3600.0, end_s / 3600.0
    step = next((s for s in _HOURS if last - first <= 12.0 * s), (last - first) / 10.0)
    return np.arange(math.ceil(first / step - 1e-9), math.floor(last / step + 1e-9) + 1).astype(np.float64) * step


def contact_run(
    states: Sequence[tuple[str, float, float]], windows: Windows, required_rad: float | None = None
) -> Figure:
    """States of a simulated contact above the pointing error in its sampled windows.

    Args:
        states: name, begin and end of each, in seconds.
        windows: the errors in the windows.
        required_rad: radial error that is allowed, rad; None draws no line for it.
    """
    names = [*dict.fromkeys(name for name, _, _ in states)]
    rows = [(name, np.array([[a, b] for which, a, b in states if which == name])) for name in names]
    sheet = _contact_run(rows, windows, required_rad) if rows else empty("no contact was run")
    caption = (
        "States of the terminal, one row each; at the right how often and how long in all. "
        "Below: radial pointing error in the windows that were simulated in full."
    )
    columns = {f"{name}, start (s)": at[:, 0] for name, at in rows} | {
        f"{name}, end (s)": at[:, 1] for name, at in rows
    }
    columns |= {"window (s)": windows.time_s, "rms (rad)": windows.rms_rad, "largest (rad)": windows.largest_rad}
    return Figure("contact-run", "A contact, simulated", caption, sheet, columns)


def _contact_run(rows: Sequence[tuple[str, Floats]], windows: Windows, required_rad: float | None) -> Sheet:
    high, low = 0.24 * len(rows), 1.7 if windows.time_s.size else 0.5
    sheet = Sheet(WIDTH, 1.3 + high + low, heights=(high, low), share_x=True, legend=Legend("below", 3))
    above, below = sheet.panel(0), sheet.panel(1)
    spare = [colour for colour in _COLOURS if colour not in _STATES.values()]
    others = [name for name, _ in rows if name not in _STATES]
    colours = [_STATES[name] if name in _STATES else spare[others.index(name) % len(spare)] for name, _ in rows]
    _bars(above, rows, colours, 60.0)
    everything = np.concatenate([at for _, at in rows]) / 60.0
    for panel in (above, below):
        panel.x.low, panel.x.high = float(everything.min()), float(everything.max())
    if windows.time_s.size:
        _errors(below, windows, required_rad)
    else:
        below.y.ticks = ()
        words = "no window was simulated in full"
        below.add(Words(words, 0.5, 0.5, GREY, 9.0, anchor="middle", of_panel="xy"))
    below.x.title = "time since the start of the contact (min)"
    return sheet


def _errors(panel: Panel, windows: Windows, required_rad: float | None) -> None:
    minutes = windows.time_s / 60.0
    for values, colour, marker, label in (
        (windows.largest_rad, VERMILION, "^", "largest"),
        (windows.rms_rad, BLUE, "o", "rms"),
    ):
        panel.add(Line(minutes, values * 1e6, colour, "", label=label, marker=marker, size=4.5, clip=False))
    if required_rad is not None:
        panel.add(Rule(required_rad * 1e6, False, BLACK, "--", label=f"required: {required_rad * 1e6:g} µrad"))
    found = np.concatenate([windows.largest_rad, windows.rms_rad])
    positive = found[np.isfinite(found) & (found > 0.0)]
    panel.y.log = bool(positive.size and positive.max() > 50.0 * np.median(positive))
    panel.y.low = None if panel.y.log else 0.0
    panel.y.title = "radial error (µrad)"


# ------------------------------------------------------------------------------------------------ along a contact


def along_contact(
    time_s: Floats,
    range_m: Floats,
    point_ahead_rad: Floats,
    rate_rad_s: Floats,
    doppler_hz: Floats,
    *,
    number: int,
    rise_utc: str,
) -> Figure:
    """What one contact asks of the terminals, over the time since its rise.

    Args:
        time_s: since the rise, (n,), s.
        range_m: between the satellites, (n,), m.
        point_ahead_rad: point-ahead angle, (n,), rad.
        rate_rad_s: angular rate of the line of sight, (n,), rad/s.
        doppler_hz: frequency received less sent, (n,), Hz.
        number: of the contact, from 1.
        rise_utc: when it begins, as text.
    """
    panels = {
        "range (m)": ("range (km)", range_m, 1e-3),
        "point-ahead (rad)": ("point-ahead angle (µrad)", point_ahead_rad, 1e6),
        "line-of-sight rate (rad/s)": ("line-of-sight rate (µrad/s)", rate_rad_s, 1e6),
        "Doppler (Hz)": ("Doppler shift (GHz)", doppler_hz, 1e-9),
    }
    sheet = _along_contact(time_s / 60.0, [*panels.values()]) if time_s.size else empty("no contact in this span")
    columns = {"time since rise (s)": time_s} | {heading: values for heading, (_, values, _) in panels.items()}
    caption = (
        f"Range, point-ahead angle, inertial rate of the line of sight and Doppler shift over contact {number}, "
        f"which rises at {rise_utc} UTC."
    )
    return Figure("along-contact", f"Along contact {number}", caption, sheet, columns)


def _along_contact(minutes: Floats, panels: Sequence[tuple[str, Floats, float]]) -> Sheet:
    sheet, drawn = grid(WIDTH, 4.4, 2, 2, share_x=True)
    for panel, (title, values, factor) in zip(drawn, panels, strict=True):
        panel.add(Line(minutes, values * factor, BLUE))
        panel.y.title = title
        if values.min() < 0.0 < values.max():
            panel.add(Rule(0.0, False, GREY, width=0.8))
        panel.x.low, panel.x.high = 0.0, max(float(minutes[-1]), 1e-3)
    for panel in drawn[2:]:
        panel.x.title = "time since rise (min)"
    return sheet


# ------------------------------------------------------------------------------------------------ data and delay


def data_volume(cumulative: Curves, stored: Curves) -> Figure:
    """Data over time; a name has one colour in both panels.

    Args:
        cumulative: by name the curves generated and delivered since the start: seconds since the epoch and bits, each
            (n,).
        stored: the same of what is on board.
    """
    both = {"since the start": cumulative, "stored": stored}
    some = any(time_s.size for curves in both.values() for time_s, _ in curves.values())
    sheet = _volume(cumulative, stored) if some else empty("no data were generated")
    columns: dict[str, Floats] = {} if cumulative or stored else {"time (s)": _NONE, "volume (bit)": _NONE}
    for what, curves in both.items():
        for name, (time_s, bits) in curves.items():
            columns |= {f"{name}, {what}, time (s)": time_s, f"{name}, {what} (bit)": bits}
    caption = "Above: data generated and delivered since the start. Below: what waits on board for its way down."
    caption += " Behind the mission's span nothing more is generated, and what waits is still delivered."
    return Figure("data-volume", "Data generated, delivered and stored", caption, sheet, columns)


def _volume(cumulative: Curves, stored: Curves) -> Sheet:
    sheet = Sheet(WIDTH, 4.8, heights=(1.4, 1.0), share_x=True, legend=Legend("above", 4))
    names = [*dict.fromkeys([*cumulative, *stored])]
    panels = sheet.panel(0), sheet.panel(1)
    ends = [time_s[place] for time_s, _ in (*cumulative.values(), *stored.values()) if time_s.size for place in (0, -1)]
    for panel, curves, what in zip(panels, (cumulative, stored), ("since the start", "stored on board"), strict=True):
        factor, unit = _bytes(bits for _, bits in curves.values())
        for name, (time_s, bits) in curves.items():
            drawn = time_s / 3600.0, bits / 8.0 * factor
            panel.add(Line(*drawn, *_look(names.index(name)), width=1.5, label=shortened(name)))
        most = max((float(np.max(bits, initial=0.0)) / 8.0 * factor for _, bits in curves.values()), default=1.0) or 1.0
        panel.y.title, panel.y.low = f"{what} ({unit})", -0.02 * most  # a curve that stays at zero can be seen
        panel.x.low, panel.x.high = min(ends) / 3600.0, max(ends) / 3600.0
        panel.x.ticks = _hours(min(ends), max(ends)).tolist()
    panels[1].x.title = "time (h)"
    return sheet


def _look(place: int) -> tuple[str, Dash]:
    """Black for the first curve, then the palette; the dashes differ too."""
    colours = (BLACK, *_COLOURS)
    return colours[place % len(colours)], _DASHES[place % 4]


def _bytes(several: Iterable[Floats]) -> tuple[float, str]:
    """Factor from bytes, and the unit in which the largest is a number of one to three digits."""
    most = max((float(np.max(bits, initial=0.0)) / 8.0 for bits in several), default=0.0)
    power = min(max(int(math.log10(most) // 3), 0), 5) if most > 0.0 else 0
    return 10.0 ** (-3 * power), ("byte", "kB", "MB", "GB", "TB", "PB")[power]


def reached_s(latency_s: Floats, share: Floats, wanted: float) -> float:
    """Latency (s) within which a share has arrived; infinite where it never does.

    Args:
        latency_s: latencies, rising, (n,), s.
        share: share that has arrived by each, of 1, (n,).
        wanted: share that is asked for, of 1.
    """
    if not share.size or share[-1] < wanted:
        return math.inf
    return float(np.interp(wanted, share, latency_s))


def latency(curves: Curves) -> Figure:
    """Share of the data delivered within a latency: pairs of (n,), seconds and shares of one, both rising.

    The axis is logarithmic: a relay takes seconds, a wait for the next station hours.
    """
    columns: dict[str, Floats] = {} if curves else {"latency (s)": _NONE, "share": _NONE}
    for name, (latency_s, share) in curves.items():
        columns |= {f"{name}, latency (s)": latency_s, f"{name}, share": share}
    some = any(np.any((latency_s > 0.0) & (share > 0.0)) for latency_s, share in curves.values())
    sheet = _latency(curves) if some else empty("nothing was delivered")
    caption = "Share of the data that has arrived within a time after it was recorded. Circle: median. Diamond: 99 %."
    return Figure("latency", "From recording to delivery", caption, sheet, columns)


def _latency(curves: Curves) -> Sheet:
    sheet, (panel,) = grid(WIDTH, 3.6)
    sheet.legend = Legend("above")
    for level in (50.0, 99.0):
        panel.add(Rule(level, False, GREY, ":", 0.7))
    for place, (name, (latency_s, share)) in enumerate(curves.items()):
        median_s, most_s = (reached_s(latency_s, share, wanted) for wanted in (0.5, 0.99))
        words = ", ".join(f"{q} {duration(s)}" for q, s in (("median", median_s), ("99 %", most_s)) if s < math.inf)
        if most_s == math.inf:
            words += f"{', ' if words else ''}{100.0 * float(np.max(share, initial=0.0)):.3g} % arrive"
        colour, dash = _look(place + 1)
        panel.add(Line(latency_s, 100.0 * share, colour, dash, 1.5, f"{shortened(name)}: {words}"))
        for at_s, level, marker in ((median_s, 50.0, "o"), (most_s, 99.0, "D")):
            if at_s < math.inf:
                panel.add(Line(np.array([at_s]), np.array([level]), colour, "", marker=marker, clip=False))
    shown = np.concatenate([each[(share > 0.0) & (each > 0.0)] for each, share in curves.values()])
    begin, end = _round_below(max(float(shown.min()) / 2.0, float(shown.max()) * 1e-7)), float(shown.max()) * 1.2
    ticks = _durations(_WIDE, begin, end)
    panel.x.ticks = ticks if len(ticks) > 3 else _durations(_DENSE, begin, end)
    panel.x.log, panel.x.low, panel.x.high, panel.x.title = True, begin, end, "time from recording to delivery"
    panel.y.title, panel.y.low, panel.y.high = "share of the data (%)", 0.0, 101.0
    return sheet


def _round_below(value: float) -> float:
    """The next of 1, 2, 5 times a power of ten that is not above a positive value."""
    power = 10.0 ** math.floor(math.log10(value))
    return power * next(step for step in (5.0, 2.0, 1.0) if step * power <= value or step == 1.0)


def _durations(of: Mapping[str, Sequence[float]], begin_s: float, end_s: float) -> dict[float, str]:
    """Those of some round lengths of time that lie within both, with their words."""
    found = {count * _UNITS_S[unit]: f"{count:g} {unit}" for unit, counts in of.items() for count in counts}
    return {time_s: words for time_s, words in found.items() if begin_s <= time_s <= end_s}


# ------------------------------------------------------------------------------------------------ assumptions
class Assumed(NamedTuple):
    """What one assumption does to a number: that number with the assumption at its lower and at its higher value.

    ``label`` names the assumption and its values, a side that is as assumed left out. A number may be infinite, or nan
    where there is none.
    """

    label: str
    low: float
    high: float


def assumptions(swings: Sequence[Assumed], value: float, quantity: str) -> Figure:
    """A number over each assumption, one at a time, the first on top.

    Args:
        swings: each assumption with what the number becomes on both sides.
        value: the number as it is.
        quantity: its name with its unit.
    """
    shown = swings[:MOST_BARS]
    if shown and math.isfinite(value):
        sheet = _tornado(shown, value, f"{quantity}; as assumed: {plain(value, 4)}")
    else:
        sheet = empty("no assumption was varied" if math.isfinite(value) else f"{quantity}: no finite value")
    caption = f"{quantity[:1].upper()}{quantity[1:]}: one assumption at a time at its lower and at its higher value."
    if len(swings) > len(shown):
        caption += f" {len(swings) - len(shown)} more, which change less, are in the data only."
    columns = {"as assumed": np.array([value])}
    columns |= {f"{s.label}, lower": np.array([s.low]) for s in swings}
    columns |= {f"{s.label}, higher": np.array([s.high]) for s in swings}
    return Figure("assumptions", "What the assumptions decide", caption, sheet, columns)


def _tornado(shown: Sequence[Assumed], value: float, label: str) -> Sheet:
    labels = [in_lines(s.label) for s in shown]
    most = max(label.count("\n") + 1 for label in labels)
    sheet, (panel,) = grid(WIDTH, 1.0 + max(0.27, 0.14 * most + 0.06) * len(shown))
    swing_bars(panel, labels, [(s.low, s.high) for s in shown], value)
    panel.x.title, sheet.legend = label, swing_legend("assumption", "above", 2)
    return sheet


# ------------------------------------------------------------------------------------------------ of a study


def day_figures(day: DayStudy, run: ContactRun | None = None) -> tuple[Figure, ...]:
    """Every figure of a day.

    Args:
        day: what the links deliver.
        run: one of its contacts, simulated, or None.
    """
    found = [contacts_figure(day), *_along_figure(day), _volume_figure(day), _latency_figure(day), ground_map(day)]
    found += [_assumptions_figure(day), *(() if day.optical is None else (_optical_figure(day, day.optical),))]
    return tuple(found if run is None else [*found, _contact_run_figure(day, run)])


def contacts_figure(day: DayStudy) -> Figure:
    """Contacts with the relay and with each station, and the eclipses, over the span of a day."""
    span = day.view.pair.span_s
    rows = [(day.relay.name, spans(day.relay.contacts, span[1]))]
    for way, kind in ((day.direct, "direct"), (day.optical, "optical")):
        for station in dict.fromkeys(() if way is None else way.stations):
            assert way is not None
            own = tuple(c for c, s in zip(way.contacts, way.stations, strict=True) if s == station)
            rows.append((f"{kind}: {station}", spans(own, span[1])))
    rows.append((f"eclipse of {day.view.pair.leo.name}", day.view.umbra_s))
    return timeline(rows, span, day.view.pair.epoch.text)


def spans(contacts: Sequence[orbit.Contact], end_s: float) -> Floats:
    """Begins and ends (n, 2), in seconds since the epoch.

    Args:
        contacts: in any order.
        end_s: where the span ends, which cuts off a contact, in seconds since the epoch.
    """
    return np.array([(c.start_s, min(c.end_s, end_s)) for c in contacts]).reshape(-1, 2)


def _along_figure(day: DayStudy) -> list[Figure]:
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
    sight = since_s, seen.range_m, seen.point_ahead_rad, seen.rate_rad_s, doppler
    return [along_contact(*sight, number=number, rise_utc=rise)]


def _volume_figure(day: DayStudy) -> Figure:
    history = day.relay.history
    cumulative = {"made by the instrument": (history.time_s, history.generated_bit)}
    stored = {}
    for way in day.ways:
        cumulative[way.name] = way.history.time_s, way.history.delivered_bit
        stored[way.name] = way.history.time_s, way.history.stored_bit
    return data_volume(cumulative, stored)


def _latency_figure(day: DayStudy) -> Figure:
    return latency({way.name: _distribution(way) for way in day.ways})


def _distribution(way: Way) -> tuple[Floats, Floats]:
    """Latency and the share of the data that arrived within it: on both sides of each bend, and evenly between."""
    bends = np.unique(np.concatenate((way.latency.first_s, way.latency.last_s)))
    if not bends.size:
        return bends, bends
    bends = np.append(bends[:: max(bends.size // _SHARES, 1)], bends[-1])
    even = np.linspace(bends[0], bends[-1], _SHARES)
    latency_s = np.unique(np.concatenate((bends, bends * (1.0 - _BEFORE), even)))
    return latency_s, way.latency.cdf(latency_s)


def ground_map(day: DayStudy) -> Figure:
    """The world with the ground track, the relay and the stations."""
    o = day.operations
    track = ground_track(day.view, day.ways, None if o is None else o.downlink, None if o is None else o.optical)
    places = Places(track.latitude_rad, track.longitude_rad)
    relay, stations = ({} if track.relay is None else dict([_marked(track.relay)])), dict(map(_marked, track.stations))
    first_s = LONGEST_S if day.view.duration_s > LONGEST_S else None
    return world_map(places, track.open, relay, stations, first_s)


def _marked(each: Outline) -> tuple[str, Marked]:
    place = Places(each.latitude_rad, each.longitude_rad)
    return each.name, Marked(place, Places(each.around_latitude_rad, each.around_longitude_rad))


def _assumptions_figure(day: DayStudy) -> Figure:
    """The bars stand in the order in which assumptions move the comparison, as the words about them do."""
    swings = sorted(day.swings, key=lambda s: -s.of_relay)
    if day.direct is not None:
        bars = [Assumed(_label(s), s.at_low.ratio, s.at_high.ratio) for s in swings]
        return assumptions(bars, day.ratio, f"volume by {day.view.partner} over volume direct")
    bars = [Assumed(_label(s), s.at_low.relay_bit / 8e12, s.at_high.relay_bit / 8e12) for s in swings]
    return assumptions(bars, day.relay.capacity_bit / 8e12, f"volume by the {day.view.partner} (TB)")


def _optical_figure(day: DayStudy, way: Way) -> Figure:
    """The same of the optical downlink's volume, for those assumptions that move it."""
    swings = sorted((s for s in day.swings if s.of_optical > 1.0), key=lambda s: -s.of_optical)
    bars = [Assumed(_label(s), s.at_low.optical_bit / 8e12, s.at_high.optical_bit / 8e12) for s in swings]
    found = assumptions(bars, way.capacity_bit / 8e12, "volume by the optical downlink (TB)")
    return replace(found, name="optical-assumptions", title="What the assumptions decide for the optical downlink")


def _label(swing: Swing) -> str:
    """The assumption and what it is changed to."""
    changed = [side for side in (swing.low, swing.high) if side != NOTHING]
    return f"{swing.name}: {' / '.join(changed)}" if changed else swing.name


def _contact_run_figure(day: DayStudy, run: ContactRun) -> Figure:
    begin = run.contact.start_s
    states = [(a.to, a.time_s - begin, b.time_s - begin) for a, b in pairwise(run.log) if b.time_s > a.time_s]
    windows = Windows(
        np.array([w.start_s + w.seconds / 2.0 - begin for w in run.windows]),
        np.array([w.rms_rad for w in run.windows]),
        np.array([w.largest_rad for w in run.windows]),
    )
    return contact_run(states, windows, day.data.requirement.pointing_error_rad)
