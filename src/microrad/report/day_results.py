"""The numbers of a day as groups: contacts, passes, the store by each way, one contact in time, sessions."""

from dataclasses import replace

import numpy as np

from microrad.core.arrays import Floats
from microrad.orbit import Contact
from microrad.orbit.constellation import ConstellationPlan
from microrad.orbit.day import DayStudy, Way
from microrad.report.variables import Group, Variable, coordinate, variable
from microrad.study.contact_run import ContactRun


def groups(day: DayStudy, run: ContactRun | None, plan: ConstellationPlan | None) -> dict[str, Group]:
    """By group: "day/contacts", "day/relay" and the others that the study has."""
    found = {
        "day/contacts": _contacts(day),
        "day/line_of_sight": _line_of_sight(day),
        "day/assumptions": _assumptions(day),
        f"day/{_group(day.relay)}": _way(day.relay),
    }
    if day.direct is not None:
        found["day/passes"] = _passes(day.direct)
        found[f"day/{_group(day.direct)}"] = _way(day.direct)
    if run is not None:
        found["day/contact_run"] = _run(run)
    if plan is not None:
        found["day/sessions"] = _sessions(plan)
    return {name: replace(each, attributes={"epoch": day.view.pair.epoch.text}) for name, each in found.items()}


def _group(way: Way) -> str:
    return way.name.replace(" ", "_")


def _spans(contacts: tuple[Contact, ...]) -> dict[str, Variable]:
    dims = ("contact",)
    return {
        "start": variable(dims, [c.start_s for c in contacts], "s", "begin, since the epoch"),
        "end": variable(dims, [c.end_s for c in contacts], "s", "end, since the epoch"),
        "begins": variable(dims, np.array([c.begins for c in contacts], dtype=object), "1", "what begins it"),
        "ends": variable(dims, np.array([c.ends for c in contacts], dtype=object), "1", "what ends it"),
    }


def _contacts(day: DayStudy) -> Group:
    dims, each = ("contact",), day.encounters
    quantities = {
        "range_least": ("m", "smallest range", [e.range_least_m for e in each]),
        "range_most": ("m", "largest range", [e.range_most_m for e in each]),
        "point_ahead": ("rad", "largest point-ahead angle", [e.point_ahead_most_rad for e in each]),
        "rate": ("rad/s", "largest angular rate of the line of sight", [e.rate_most_rad_s for e in each]),
        "acceleration": ("rad/s^2", "largest change of that rate", [e.acceleration_most_rad_s2 for e in each]),
        "doppler": ("Hz", "largest Doppler shift in magnitude", [e.doppler_most_hz for e in each]),
        "could_carry": ("bit", "data that it could carry within the span, mean of the runs", day.relay.carried_bit),
    }
    data = {name: variable(dims, values, unit, what) for name, (unit, what, values) in quantities.items()}
    return Group({**_spans(tuple(e.contact for e in each)), **data})


def _line_of_sight(day: DayStudy) -> Group:
    """Every contact in time, one after the other."""
    dims, each = ("sample",), day.encounters
    wavelength = day.data.table.wavelength_m
    quantities = {
        "time": ("s", "time since the epoch", [e.sight.time_s for e in each]),
        "range": ("m", "range", [e.sight.range_m for e in each]),
        "range_rate": ("m/s", "range rate, positive while they recede", [e.sight.range_rate_m_s for e in each]),
        "doppler": ("Hz", "frequency received less sent", [e.sight.doppler_hz(wavelength) for e in each]),
        "rate": ("rad/s", "angular rate of the line of sight", [e.sight.rate_rad_s for e in each]),
        "acceleration": ("rad/s^2", "change of that rate, as a vector", [e.sight.acceleration_rad_s2 for e in each]),
        "point_ahead": ("rad", "point-ahead angle", [e.sight.point_ahead_rad for e in each]),
    }
    number = [np.full(e.sight.time_s.size, float(k + 1)) for k, e in enumerate(each)]
    data = {"contact": variable(dims, _joined(number), "1", "number of the contact in the span, from 1")}
    data |= {name: variable(dims, _joined(parts), unit, what) for name, (unit, what, parts) in quantities.items()}
    return Group(data)


def _joined(parts: list[Floats]) -> Floats:
    return np.concatenate([np.zeros(0), *parts])


def _passes(way: Way) -> Group:
    stations = variable(("contact",), np.array(way.stations, dtype=object), "1", "ground station")
    carried = variable(("contact",), way.carried_bit, "bit", "data that it could carry within the span")
    return Group({**_spans(way.contacts), "station": stations, "could_carry": carried})


def _way(way: Way) -> Group:
    h, dims = way.history, ("moment",)
    data = {
        "time": variable(dims, h.time_s, "s", "time since the epoch; linear from one moment to the next"),
        "generated": variable(dims, h.generated_bit, "bit", "made by the instrument so far"),
        "delivered": variable(dims, h.delivered_bit, "bit", "sent so far"),
        "stored": variable(dims, h.stored_bit, "bit", "on board"),
        "lost": variable(dims, h.lost_bit, "bit", "lost so far for want of room"),
        "could_carry": variable((), way.capacity_bit, "bit", "what its contacts could carry, mean of the runs"),
        "latency_median": variable((), way.median_s, "s", "median latency of the data kept, all runs"),
        "latency_99_percent": variable((), way.slow_s, "s", "latency within which 99 % of it arrived"),
    }
    return Group(data)


def _assumptions(day: DayStudy) -> Group:
    found = {}
    for side in ("low", "high"):
        cases = [getattr(s, f"at_{side}") for s in day.swings]
        changed = np.array([getattr(s, side) for s in day.swings], dtype=object)
        found[side] = variable(("assumption",), changed, "1", f"{side} side of the change")
        for key, unit in (("relay_bit", "bit"), ("direct_bit", "bit"), ("relay_slow_s", "s"), ("direct_slow_s", "s")):
            name = key.rpartition("_")[0].replace("slow", "latency_99_percent")
            words = f"{name.replace('_', ' ')} with the {side} side"
            found[f"{name}_{side}"] = variable(("assumption",), [getattr(c, key) for c in cases], unit, words)
    return Group(found, coordinate("assumption", [s.name for s in day.swings], "what is changed"))


def _run(run: ContactRun) -> Group:
    entry, window = ("transition",), ("window",)
    w = run.windows
    texts = {"state": "state that is left", "to": "state that follows", "cause": "why"}
    data = {
        key: variable(entry, np.array([getattr(t, key) for t in run.log], dtype=object), "1", words)
        for key, words in texts.items()
    }
    quantities = {
        "window_start": ("s", "begin of the window, since the epoch", [x.start_s for x in w]),
        "range": ("m", "range", [x.range_m for x in w]),
        "point_ahead": ("rad", "point-ahead angle", [x.point_ahead_rad for x in w]),
        "rate": ("rad/s", "angular rate of the line of sight", [x.rate_rad_s for x in w]),
        "rms": ("rad", "radial rms of the pointing error", [x.rms_rad for x in w]),
        "largest": ("rad", "largest radial pointing error", [x.largest_rad for x in w]),
        "lowest_margin": ("dB", "lowest margin of the communication link", [x.lowest_margin_db for x in w]),
    }
    data["time"] = variable(entry, [t.time_s for t in run.log], "s", "time since the epoch")
    data |= {name: variable(window, values, unit, what) for name, (unit, what, values) in quantities.items()}
    return Group(data)


def _sessions(plan: ConstellationPlan) -> Group:
    dims, p = ("session",), plan.planned
    data = {
        "satellite": variable(dims, np.array([x.satellite for x in p], dtype=object), "1", "satellite"),
        "relay": variable(dims, np.array([x.relay for x in p], dtype=object), "1", "relay"),
        "start": variable(dims, [x.start_s for x in p], "s", "begin, since the epoch"),
        "locked": variable(dims, [x.locked_s for x in p], "s", "from when data flow, since the epoch"),
        "end": variable(dims, [x.end_s for x in p], "s", "end, since the epoch"),
        "data_rate": variable(dims, [x.rate_bit_s for x in p], "bit/s", "data rate"),
        "volume": variable(dims, [x.volume_bit for x in p], "bit", "volume"),
    }
    return Group(data)
