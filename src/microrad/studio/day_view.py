"""What the page of the day shows: contacts over time, volumes and latencies, and the tables beside them."""

from __future__ import annotations

import base64
import math
from collections.abc import Iterable
from typing import Any

import numpy as np

from microrad.core.arrays import Floats
from microrad.core.progress import Progress
from microrad.link import study as link_study
from microrad.mission.file import LinkFile
from microrad.orbit import Contact
from microrad.orbit import day as day_study
from microrad.orbit.day import DayStudy, Way
from microrad.report.day import words as day_words
from microrad.report.day.tables import CONTACT_COLUMNS, assumptions_table, contacts_table, ways_table
from microrad.report.quantities import duration
from microrad.studio import plots

Row = dict[str, Any]

MOST_POINTS = 1500
"""Of a drawn curve."""

_COLOURS = {0: plots.BLUE, 1: plots.ORANGE, 2: plots.GREEN}
_HOUR_S = 3600.0


def run(file: LinkFile, on_progress: Progress) -> DayStudy:
    """The links of a mission, then its day; raises ValueError with the reason where a day cannot be had."""
    on_progress(0, 0, "links")
    links = link_study.run(file)
    on_progress(0, 0, "contacts")
    return day_study.run(links, on_progress=on_progress)


def missing(file: LinkFile) -> str:
    """Why a mission has no day, or ""."""
    lacking = [f"[{name}]" for name in ("orbit", "operations") if getattr(file.mission, name) is None]
    if not lacking:
        return ""
    return f"The mission has no {' and no '.join(lacking)}, so it has no day; microrad init writes such tables."


# ------------------------------------------------------------------------------------------------------------- tables
def ways(day: DayStudy) -> tuple[Way, ...]:
    """The ways down that the mission has."""
    return (day.relay,) if day.direct is None else (day.relay, day.direct)


def way_rows(day: DayStudy) -> list[Row]:
    """Relay and direct downlink side by side."""
    return [{"id": place, "what": row[0], **_cells(row[1:])} for place, row in enumerate(ways_table(day).rows)]


def _cells(cells: Iterable[str]) -> Row:
    return dict(zip(("relay", "direct"), cells, strict=False))


def contact_headings() -> tuple[str, ...]:
    """Headings of the contacts, on one line each."""
    return tuple(heading.replace("\n", " ") for heading in CONTACT_COLUMNS)


def contact_rows(day: DayStudy) -> list[Row]:
    """Each contact by both ways, in the order of their rise; cells by the number of their column."""
    rows = contacts_table(day).rows
    return [{"id": place, **{f"c{k}": cell for k, cell in enumerate(row)}} for place, row in enumerate(rows)]


def swing_rows(day: DayStudy) -> list[Row]:
    """What each assumption changes, alone."""
    names = ("assumption", "changed", "relay", "direct", "ratio", "slow_relay", "slow_direct")
    return [
        {"id": place, **dict(zip(names, row, strict=True))} for place, row in enumerate(assumptions_table(day).rows)
    ]


def words(day: DayStudy) -> list[str]:
    """The answers of the day, a sentence each, and the warnings."""
    return [*day_words.sentences(day), *(f"Warning: {warning}." for warning in day.warnings)]


# -------------------------------------------------------------------------------------------------------------- plots
def timeline_rows(day: DayStudy) -> list[tuple[str, int, Floats]]:
    """Rows of the timeline: name, colour's number, intervals (n, 2) in seconds since the epoch."""
    end_s = day.view.pair.span_s[1]
    rows = [(day.relay.name, 0, _intervals(day.relay.contacts, end_s))]
    if day.direct is not None:
        for station in dict.fromkeys(day.direct.stations):
            pairs = zip(day.direct.contacts, day.direct.stations, strict=True)
            rows.append((f"direct: {station}", 1, _intervals((c for c, s in pairs if s == station), end_s)))
    umbra: Floats = np.reshape(np.asarray(day.view.umbra_s, dtype=np.float64), (-1, 2))
    return [*rows, (f"eclipse of {day.view.pair.leo.name}", 2, umbra)]


def _intervals(contacts: Iterable[Contact], end_s: float) -> Floats:
    found: Floats = np.array([(c.start_s, min(c.end_s, end_s)) for c in contacts], dtype=np.float64)
    return found.reshape(-1, 2)


def timeline_plot(day: DayStudy) -> plots.Plot:
    """Contacts and eclipses as bars over the hours since the epoch, a row each."""
    utc = day.view.pair.epoch.utc
    names: list[str] = []
    data: list[plots.Trace] = []
    for name, colour, intervals in timeline_rows(day):
        row = f"{plots.plain(name, 26)}: {_how_much(intervals)}"
        names.append(row)
        said = [f"{_clock(utc(a))} to {_clock(utc(b))}, {duration(b - a)}" for a, b in intervals.tolist()]
        data.append(
            {
                "type": "bar",
                "orientation": "h",
                "name": plots.plain(name),
                "y": [row] * len(said),
                "base": np.round(intervals[:, 0] / _HOUR_S, 5).tolist(),
                "x": np.round((intervals[:, 1] - intervals[:, 0]) / _HOUR_S, 5).tolist(),
                "text": said,
                "textposition": "none",
                "marker": {"color": _COLOURS[colour], "line": {"width": 1, "color": _COLOURS[colour]}},
                "hovertemplate": "%{text}<extra></extra>",
                "showlegend": False,
            }
        )
    begin, end = (each / _HOUR_S for each in day.view.pair.span_s)
    return plots.plot(
        data,
        {"title": f"hours since {plots.plain(day.view.pair.epoch.text)}", "range": [begin, end]},
        {"title": "", "categoryorder": "array", "categoryarray": names, "range": [len(names) - 0.5, -0.5]},
        barmode="overlay",
        height=110 + 34 * len(names),
    )


def _how_much(intervals: Floats) -> str:
    """How many there are, and how long in all."""
    if not len(intervals):
        return "none"
    return f"{len(intervals)}, {duration(float(np.sum(intervals[:, 1] - intervals[:, 0])))}"


def _clock(utc: str) -> str:
    return utc[:19].replace("T", " ")


def ground_map(day: DayStudy) -> tuple[str, str]:
    """The report's map of the day as the address of an image, and what it shows in words."""
    from microrad.report.day.figures import ground_map

    figure = ground_map(day)
    return f"data:image/svg+xml;base64,{base64.b64encode(figure.svg.encode()).decode()}", figure.caption


def volume_plot(day: DayStudy) -> plots.Plot:
    """Data made, delivered and stored over the hours since the epoch."""
    made = day.relay.history
    curves = [("made by the instrument", made.time_s, made.generated_bit, plots.BLACK, "solid")]
    for place, way in enumerate(ways(day)):
        h, colour = way.history, _COLOURS[place]
        curves.append((f"delivered, {way.name}", h.time_s, h.delivered_bit, colour, "solid"))
        curves.append((f"on board, {way.name}", h.time_s, h.stored_bit, colour, "dot"))
    most = max((float(np.max(bits, initial=0.0)) for _, _, bits, _, _ in curves), default=0.0) / 8.0
    factor, unit = _bytes(most)
    data = [
        _curve(name, time_s / _HOUR_S, bits / 8.0 * factor, colour, dash, f"%{{y:.4g}} {unit}")
        for name, time_s, bits, colour, dash in curves
    ]
    return plots.plot(
        data,
        {"title": f"hours since {plots.plain(day.view.pair.epoch.text)}"},
        {"title": f"data ({unit})", "rangemode": "tozero"},
        hovermode="x unified",
    )


def latency_plot(day: DayStudy) -> plots.Plot:
    """Share of the data kept that has arrived within a time after it was recorded; the time on a logarithmic axis."""
    data = []
    for place, way in enumerate(ways(day)):
        time_s, share = distribution(way)
        some = (share > 0.0) & (time_s > 0.0)
        if some.any():
            said = f"{way.name}: median {duration(way.median_s)}, 99 % {duration(way.slow_s)}"
            data.append(
                _curve(said, time_s[some], 100.0 * share[some], _COLOURS[place], plots.DASHES[place], "%{y:.3g} %")
            )
    if not data:
        return plots.empty("nothing was delivered")
    values, ticks = _lengths(min(d["x"][0] for d in data), max(d["x"][-1] for d in data))
    x = {"title": "time from recording to delivery", "type": "log", "tickvals": values, "ticktext": ticks}
    return plots.plot(data, x, {"title": "share of the data (%)", "range": [0.0, 101.0]}, hovermode="x")


def distribution(way: Way) -> tuple[Floats, Floats]:
    """Latencies (s) and the share of the data that arrived within each, evenly over their logarithm."""
    bends = np.unique(np.concatenate((way.latency.first_s, way.latency.last_s)))
    bends = bends[np.isfinite(bends) & (bends > 0.0)]
    if not bends.size:
        return bends, bends
    even = np.geomspace(bends[0] * 0.9, bends[-1], MOST_POINTS // 2)
    chosen = bends[:: max(bends.size // (MOST_POINTS // 2), 1)]
    time_s = np.unique(np.concatenate((even, chosen, chosen * (1.0 - 1e-9))))
    return time_s, way.latency.cdf(time_s)


def _curve(name: str, x: Floats, y: Floats, color: str, dash: str, said: str) -> plots.Trace:
    step = max(x.size // MOST_POINTS, 1)
    picks = np.unique(np.append(np.arange(0, x.size, step), x.size - 1)) if x.size else np.zeros(0, dtype=int)
    return {
        "type": "scatter",
        "mode": "lines",
        "name": plots.plain(name, 70),
        "x": [float(f"{value:.6g}") for value in x[picks]],
        "y": [float(f"{value:.6g}") for value in y[picks]],
        "line": {"color": color, "width": 2, "dash": dash},
        "hovertemplate": said,
    }


def _bytes(most: float) -> tuple[float, str]:
    """Factor from bytes, and the unit in which the largest is a number of one to three digits."""
    power = min(max(int(math.log10(most) // 3), 0), 5) if most > 0.0 else 0
    return 10.0 ** (-3 * power), ("byte", "kB", "MB", "GB", "TB", "PB")[power]


def _lengths(first_s: float, last_s: float) -> tuple[list[float], list[str]]:
    """Round lengths of time between two."""
    units = {"s": (1e-3, 1e-2, 0.1, 1.0, 10.0), "min": (60.0, 600.0), "h": (3600.0, 21600.0), "d": (86400.0, 604800.0)}
    size = {"s": 1.0, "min": 60.0, "h": 3600.0, "d": 86400.0}
    found = [
        (t, f"{t / size[unit]:g} {unit}") for unit, those in units.items() for t in those if first_s <= t <= last_s
    ]
    return [t for t, _ in found], [said for _, said in found]
