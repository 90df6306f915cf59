"""The plan of a constellation in words, as a view and as plain data."""

from typing import Any

import numpy as np

from microrad.orbit.constellation import ConstellationPlan
from microrad.report.quantities import are, counted, duration, volume
from microrad.report.tables import Table
from microrad.report.view import View, told, views_text

MOST_ROWS = 40
"""Satellites of a table; there may be thousands."""


def plan_sentences(plan: ConstellationPlan) -> list[str]:
    """What the plan comes to."""
    served, gaps = plan.by_satellite.served_s, plan.by_satellite.longest_gap_s
    seen = float(np.sum(plan.opportunities.end_s - plan.opportunities.start_s))
    span = plan.span_s[1] - plan.span_s[0]
    used = ", ".join(f"{name} {100 * use:.0f} %" for name, use in zip(plan.relays, plan.use, strict=True))
    satellites = "1 satellite shares" if len(plan.satellites) == 1 else f"{len(plan.satellites)} satellites share"
    relays = "1 relay" if len(plan.relays) == 1 else f"{len(plan.relays)} relays"
    each = "" if len(plan.relays) == 1 else " each"
    terminals = "one terminal" if plan.terminals == 1 else f"{plan.terminals} terminals"
    ground = f" and {_ground(plan)}" if plan.stations else ""
    take, carry = ("takes", "carries") if len(plan.planned) == 1 else ("take", "carry")
    views, busy = plan.opportunities.start_s.size, float(np.sum(plan.by_satellite.busy_s))
    return [
        f"{satellites} {relays} of {terminals}{each}{ground}: in {duration(span)} "
        f"{counted(views, 'contact')} in reach, {seen / 3600.0:.0f} h in all, of which "
        f"{counted(len(plan.planned), 'session')} {take} {busy / 3600.0:.0f} h and {carry} {volume(plan.volume_bit)}.",
        f"A satellite has data for {duration(float(np.min(served)))} to {duration(float(np.max(served)))}, and waits "
        f"{duration(float(np.max(gaps)))} at most. Terminals in use: {used}.",
        f"In reach is where the link closes at its lowest rate, with a pointing loss of {plan.loss.loss_db:.2f} dB "
        f"({plan.loss.source}).",
        *_stations_words(plan),
    ]


def _ground(plan: ConstellationPlan) -> str:
    """The ground stations with their terminals in all."""
    terminals = sum(plan.station_terminals)
    stations = "1 ground station" if len(plan.stations) == 1 else f"{len(plan.stations)} ground stations"
    all_of_them = "" if len(plan.stations) == 1 else " in all"
    return f"{stations} of {'one terminal' if terminals == 1 else f'{terminals} terminals'}{all_of_them}"


def _stations_words(plan: ConstellationPlan) -> list[str]:
    """What the ground stations take; nothing without any."""
    if not plan.stations:
        return []
    count = int(np.sum(plan.by_station.sessions))
    used = ", ".join(f"{name} {100 * use:.0f} %" for name, use in zip(plan.stations, plan.station_use, strict=True))
    return [
        f"{count} of the sessions {are(count)} with ground stations, above their masks, and {are(count)} expected "
        f"to carry {volume(float(np.sum(plan.by_station.volume_bit)))} under their availability. "
        f"Terminals in use: {used}."
    ]


def partners_table(plan: ConstellationPlan) -> Table | None:
    """What each relay and each ground station takes; None without stations."""
    if not plan.stations:
        return None
    rows, names = [], []
    for kind, of, uses, each in (
        ("relays", plan.by_relay, plan.use, [plan.terminals] * len(plan.relays)),
        ("stations", plan.by_station, plan.station_use, plan.station_terminals),
    ):
        for k, name in enumerate(plan.relays if kind == "relays" else plan.stations):
            sessions, carried = str(int(of.sessions[k])), volume(of.volume_bit[k])
            rows.append((name, str(each[k]), sessions, f"{100 * uses[k]:.0f} %", carried))
            names.append(f"constellation.{kind}.{name}")
    headings, title = ("relay or station", "terminals", "sessions", "in use", "volume"), "What each of them takes"
    of_columns = ((2, "sessions"), (3, "use"), (4, "volume_bit"))
    own = {place: [f"{name}.{what}" for name in names] for place, what in of_columns}
    return Table(title, headings, rows, (0,), folded=title, names=own)


def satellites_table(plan: ConstellationPlan) -> Table:
    """What each satellite gets, the first `MOST_ROWS` of them."""
    t = plan.by_satellite
    rows = [
        (name, str(int(t.sessions[k])), duration(t.served_s[k]), duration(t.longest_gap_s[k]), volume(t.volume_bit[k]))
        for k, name in enumerate(plan.satellites[:MOST_ROWS])
    ]
    headings = ("satellite", "sessions", "with data", "longest time without", "volume")
    of, title = ("sessions", "with_data_s", "longest_gap_s", "volume_bit"), "What each satellite gets"
    names = {place: f"constellation.satellites.x.{name}" for place, name in enumerate(of, 1)}
    return Table(title, headings, rows, (0,), folded=title, names=names)


def constellation_view(plan: ConstellationPlan) -> View:
    """Who is served when."""
    blocks = told(*plan_sentences(plan), satellites_table(plan), partners_table(plan))
    return View("A constellation", blocks, folded=True)


def plan_text(plan: ConstellationPlan, width: int) -> str:
    """The plan in sentences and a table for a terminal.

    Args:
        plan: who is served when.
        width: columns of the terminal.
    """
    count = len(plan.satellites)
    more = f"The first {MOST_ROWS} of {count} satellites; --csv has every session." if count > MOST_ROWS else ""
    return views_text([constellation_view(plan), more], width)


def plan_data(plan: ConstellationPlan) -> dict[str, Any]:
    """The plan as plain data, in SI units with the unit in each key."""
    by = plan.by_satellite
    return {
        "epoch": plan.epoch.text,
        "duration_s": plan.span_s[1] - plan.span_s[0],
        "contacts": int(plan.opportunities.start_s.size),
        "sessions": len(plan.planned),
        "volume_bit": plan.volume_bit,
        "relays": [{"name": n, "use": float(u)} for n, u in zip(plan.relays, plan.use, strict=True)],
        **({"stations": _stations_data(plan)} if plan.stations else {}),
        "satellites": [
            {
                "name": name,
                "sessions": int(by.sessions[k]),
                "with_data_s": float(by.served_s[k]),
                "longest_gap_s": float(by.longest_gap_s[k]),
                "volume_bit": float(by.volume_bit[k]),
            }
            for k, name in enumerate(plan.satellites)
        ],
    }


def _stations_data(plan: ConstellationPlan) -> list[dict[str, Any]]:
    by = plan.by_station
    return [
        {
            "name": name,
            "use": float(plan.station_use[k]),
            "sessions": int(by.sessions[k]),
            "volume_bit": float(by.volume_bit[k]),
        }
        for k, name in enumerate(plan.stations)
    ]
