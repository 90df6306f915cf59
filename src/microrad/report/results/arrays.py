"""The numbers of a study as netCDF: arrays with their unit and meaning, in groups."""

import io
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import h5netcdf
import h5py
import numpy as np
from numpy.typing import NDArray

from microrad.core.arrays import Floats
from microrad.loop.fine_pointing import COUNTERS, FinePointingStudy, Residual
from microrad.loop.paper_cases import Run
from microrad.orbit import Contact
from microrad.orbit.constellation import ConstellationPlan
from microrad.orbit.day import DayStudy, Way
from microrad.report.fine_pointing.data import margins, rms_by_source, sources
from microrad.study.contact_run import ContactRun
from microrad.study.study import Study


@dataclass(frozen=True, slots=True)
class Variable:
    """An array by its dimensions, with its unit and its meaning. Texts are of dtype object."""

    dims: tuple[str, ...]
    values: NDArray[Any]
    units: str
    long_name: str


@dataclass(frozen=True, slots=True)
class Group:
    """Variables by name, coordinates by the dimension that they number, and attributes of the whole."""

    variables: Mapping[str, Variable]
    coordinates: Mapping[str, Variable] = field(default_factory=dict)
    attributes: Mapping[str, object] = field(default_factory=dict)


def variable(dims: tuple[str, ...], values: object, units: str, long_name: str) -> Variable:
    """An array with its unit and its meaning."""
    array = np.asarray(values)
    return Variable(dims, array.astype(object) if array.dtype.kind == "U" else array, units, long_name)


def coordinate(dimension: str, values: Sequence[str], long_name: str) -> dict[str, Variable]:
    """A coordinate of names."""
    return {dimension: variable((dimension,), np.asarray(values, dtype=object), "1", long_name)}


def study_netcdf(study: Study) -> bytes:
    """The content of results.nc.

    It has margin map, hysteresis loops, traces, fine-pointing loop and the day; each variable with its unit.
    """
    groups = {"margin_map": _map(study), "link_performance": _performance(study), **_loops(study)}
    for run in study.runs:
        name = f"{run.mirror} {run.controller} {run.freq_hz:g}_hz".replace(" + ", "_").replace(" ", "_").lower()
        groups[f"tracking/{name}"] = _trace(run)
    if study.fine_pointing is not None:
        groups |= _fine_pointing(study.fine_pointing)
    if study.day is not None:
        groups |= _day(study.day, study.contact, study.plan)
    return _netcdf_bytes(groups, {"title": study.file.mission.name, "mission_sha256": study.file.sha256})


def _netcdf_bytes(groups: Mapping[str, Group], attributes: Mapping[str, str]) -> bytes:
    """The content of a netCDF file of these groups; where a number is missing it is nan."""
    content = io.BytesIO()
    with h5netcdf.File(content, "w") as file:
        file.attrs.update(attributes)
        for path, each in groups.items():
            group = file.create_group(path)
            group.attrs.update(each.attributes)
            for name, of in {**each.coordinates, **each.variables}.items():
                for dimension, length in zip(of.dims, of.values.shape, strict=True):
                    if dimension not in group.dimensions:
                        group.dimensions[dimension] = length
                kind = h5py.string_dtype() if of.values.dtype == object else of.values.dtype
                missing = np.nan if of.values.dtype.kind == "f" and name not in each.coordinates else None
                made = group.create_variable(name, of.dims, kind, data=of.values, fillvalue=missing)
                made.attrs.update({"units": of.units, "long_name": of.long_name})
    return content.getvalue()


# ------------------------------------------------------------------------------------------------ study
def _trace(run: Run) -> Group:
    t, c = run.trace, run.trace.counts
    data = {
        "reference": variable(("time",), t.reference_rad[:, 0], "rad", "pointing reference"),
        "output": variable(("time",), t.output_rad[:, 0], "rad", "mirror output at the line of sight"),
        "command": variable(("time",), t.command_v[:, 0], "V", "controller output about the bias"),
        "drive": variable(("time",), t.drive_v[:, 0], "V", "amplifier output over its gain, about the bias"),
    }
    attributes = {
        "mirror": str(run.mirror),
        "controller": run.controller,
        "frequency_hz": run.freq_hz,
        "peak_error_rad": t.peak_rad,
        "rms_error_rad": t.rms_rad,
        "steady_from_sample": t.steady.start,
        "rate_clamped_steps": c.clamped,
        "rate_clamped_inverse_samples": c.inverse_clamped,
        "saturated_samples": c.saturated,
        "slew_limited_steps": c.slew_limited,
        "alternating_samples": c.alternating,
    }
    return Group(data, {"time": variable(("time",), t.time_s, "s", "time")}, attributes)


def _map(study: Study) -> Group:
    f = study.margin_map
    return Group(
        {"margin": variable(("data_rate", "pointing_error"), f.margin_db, "dB", "margin of the communication link")},
        {
            "data_rate": variable(("data_rate",), f.data_rate_bit_s, "bit/s", "data rate"),
            "pointing_error": variable(("pointing_error",), f.pointing_error_rad, "rad", "pointing error"),
        },
    )


def _loops(study: Study) -> dict[str, Group]:
    bias = study.file.mission.mirror.bias_v
    return {
        f"hysteresis_loops/{loop.freq_hz:g}_hz": Group(
            {
                "drive": variable(("sample",), loop.drive_v + bias, "V", "drive"),
                "output": variable(("sample",), loop.output_rad, "rad", "output about the bias"),
                "hysteresis": variable(("sample",), loop.hysteresis_rad, "rad", "hysteresis h"),
            },
            attributes={"frequency_hz": loop.freq_hz, "width": loop.width, "rate_clamped_samples": loop.clamped},
        )
        for loop in study.loops
    }


def _fine_pointing(fine: FinePointingStudy) -> dict[str, Group]:
    """Spectra, residuals, theory by source, margins, error budget and sines of the fine-pointing loop."""
    groups = {
        "spectra": _spectra(fine),
        "residuals": _residuals(fine),
        "theory": _theory(fine),
        "margins": _loop_margins(fine),
        "error_budget": _error_budget(fine),
        "sines": _sines(fine),
    }
    return {f"fine_pointing/{name}": group for name, group in groups.items()}


def _controllers(fine: FinePointingStudy) -> dict[str, Variable]:
    return coordinate("controller", [v.design.name for v in fine.verified], "controller")


def _spectra(fine: FinePointingStudy) -> Group:
    dims, unit = ("controller", "frequency", "axis"), "rad^2/Hz"
    after = np.stack([v.spectrum_rad2_hz for v in fine.verified])
    predicted = np.stack([v.predicted_rad2_hz for v in fine.verified])
    before = "one-sided spectrum of the disturbances of an axis before the loop, lines left out"
    data = {
        "before": variable(("frequency",), fine.disturbed_rad2_hz, unit, before),
        "residual": variable(dims, after, unit, "one-sided spectrum of the simulated residual, mission's mirror"),
        "predicted": variable(dims, predicted, unit, "one-sided spectrum of the residual in linear theory"),
    }
    freq = {"frequency": variable(("frequency",), fine.freq_hz, "Hz", "frequency")}
    axes = coordinate("axis", _axes(fine), "axis of the line of sight")
    return Group(data, {**_controllers(fine), **freq, **axes})


def _axes(fine: FinePointingStudy) -> tuple[str, ...]:
    return ("x", "y")[: fine.scene.loop.axes]


def _residuals(fine: FinePointingStudy) -> Group:
    variants = tuple(dict.fromkeys(name for v in fine.verified for name in v.simulated))
    limits = tuple(COUNTERS)
    table = [[v.simulated.get(name) for name in variants] for v in fine.verified]

    def gathered(pick: Callable[[Residual], Any], missing: Any = math.nan) -> Floats:
        return np.array([[missing if r is None else pick(r) for r in row] for row in table], dtype=float)

    dims, no_axes = ("controller", "mirror"), [math.nan] * fine.scene.loop.axes
    shares = gathered(lambda r: [r.shares.get(name, 0.0) for name in limits], [math.nan] * len(limits))
    axis_rms = gathered(lambda r: r.axis_rms_rad, no_axes)
    at = f"radial error that {fine.quantile:g} of the time stays below"
    interval = "half width of the 99 % interval of the radial rms over the runs"
    data = {
        "rms": variable(dims, gathered(lambda r: r.rms_rad), "rad", "radial rms"),
        "rms_interval": variable(dims, gathered(lambda r: r.rms_interval_rad), "rad", interval),
        "axis_rms": variable((*dims, "axis"), axis_rms, "rad", "rms by axis"),
        "quantile": variable(dims, gathered(lambda r: r.quantile_rad), "rad", at),
        "largest": variable(dims, gathered(lambda r: r.largest_rad), "rad", "largest radial error"),
        "share": variable((*dims, "limit"), shares, "1", "share of samples or plant steps at which a limit was met"),
    }
    names = {**_controllers(fine), **coordinate("mirror", variants, "variant of the mirror")}
    names |= coordinate("axis", _axes(fine), "axis of the line of sight") | coordinate("limit", limits, "limit")
    return Group(data, names, {"quantile": fine.quantile, "best": fine.best.design.name})


def _theory(fine: FinePointingStudy) -> Group:
    names = sources(fine.verified)
    parts = [rms_by_source(v) for v in fine.verified]
    by_source = np.array([[part.get(name, math.nan) for name in names] for part in parts])
    total = np.array([v.theory.radial_rms_rad for v in fine.verified])
    data = {
        "rms_by_source": variable(("controller", "source"), by_source, "rad", "radial rms that one source leaves"),
        "rms": variable(("controller",), total, "rad", "radial rms of all sources"),
        "bound": variable((), fine.optimum_rad, "rad", "radial rms below which no linear controller comes"),
    }
    return Group(data, {**_controllers(fine), **coordinate("source", names, "source of error")})


_MARGINS = {
    "modulus": ("1", "modulus margin, min |1 + L|"),
    "gain_up_db": ("dB", "gain margin upwards"),
    "phase_rad": ("rad", "phase margin"),
    "delay_s": ("s", "delay margin"),
    "disk": ("1", "symmetric disk margin, 2 / max |S - T|"),
    "bandwidth_hz": ("Hz", "lowest frequency with |S| = 1"),
    "crossover_hz": ("Hz", "highest frequency with |L| = 1"),
}


def _loop_margins(fine: FinePointingStudy) -> Group:
    found = [margins(v.design) for v in fine.verified]
    data = {
        key: variable(("controller",), np.array([each[key] for each in found]), unit, long_name)
        for key, (unit, long_name) in _MARGINS.items()
    }
    return Group(data, _controllers(fine))


def _error_budget(fine: FinePointingStudy) -> Group:
    b = fine.budget
    alone, theory = ([getattr(p, key) for p in b.parts] for key in ("rms_rad", "theory_rad"))
    with_it, without = ([getattr(d, key) for d in b.differences] for key in ("with_rad", "without_rad"))
    data = {
        "rms": variable(("part",), alone, "rad", "radial rms of one part alone, simulated without hysteresis"),
        "theory": variable(("part",), theory, "rad", "radial rms of one part alone in linear theory"),
        "combined": variable((), b.combined_rad, "rad", "root sum square of the parts"),
        "together": variable((), b.together_rad, "rad", "radial rms of all parts together, without hysteresis"),
        "full": variable((), b.full_rad, "rad", "radial rms of the full loop"),
        "with": variable(("left_out",), with_it, "rad", "radial rms of the full loop"),
        "without": variable(("left_out",), without, "rad", "radial rms of the full loop but for what is left out"),
    }
    names = coordinate("part", [p.name for p in b.parts], "part of the error")
    names |= coordinate("left_out", [d.name for d in b.differences], "part that is left out")
    return Group(data, names, {"controller": b.controller})


def _sines(fine: FinePointingStudy) -> Group:
    """One entry a run: not every controller need have run on every mirror."""
    s, run = fine.sines, ("run",)
    at = f"radial error that {fine.quantile:g} of the time stays below"
    data = {
        "controller": variable(run, np.array([each.controller for each in s], dtype=object), "1", "controller"),
        "mirror": variable(run, np.array([each.variant for each in s], dtype=object), "1", "variant of the mirror"),
        "frequency": variable(run, np.array([each.freq_hz for each in s]), "Hz", "frequency of the sine on axis x"),
        "rms": variable(run, np.array([each.rms_rad for each in s]), "rad", "radial rms"),
        "quantile": variable(run, np.array([each.quantile_rad for each in s]), "rad", at),
    }
    return Group(data)


def _performance(study: Study) -> Group:
    """The communication link under each simulated residual, one entry a case."""
    cases, dims = study.performance.cases, ("case",)
    half = "half angle at 1/e2 with the most power at the outage loss"
    quantities = {
        "mean_loss": ("dB", "loss of the mean power by pointing", [c.mean_loss_db for c in cases]),
        "outage_loss": (
            "dB",
            "pointing loss exceeded for the outage's share of time",
            [c.outage_loss_db for c in cases],
        ),
        "uncoded_penalty": (
            "dB",
            "power that the pointing error costs without a code; nan where the receiver's curve is not known",
            [c.uncoded_penalty_db for c in cases],
        ),
        "margin": ("dB", "margin at the outage loss", [c.margin_db for c in cases]),
        "outage": ("1", "share of the time with a margin below 0 dB", [c.outage for c in cases]),
        "below_required": ("1", "share of the time below the required margin", [c.short for c in cases]),
        "data_rate": ("bit/s", "data rate with the required margin there", [c.data_rate_bit_s for c in cases]),
        "best_half_angle": ("rad", half, [c.best.half_angle_rad for c in cases]),
    }
    data = {
        name: variable(dims, np.array([getattr(c, name) for c in cases], dtype=object), "1", what)
        for name, what in (
            ("source", "pointing error"),
            ("controller", "controller"),
            ("mirror", "variant of the mirror"),
        )
    }
    data |= {name: variable(dims, np.array(values), unit, what) for name, (unit, what, values) in quantities.items()}
    return Group(data, attributes={"outage": study.performance.outage})


# ------------------------------------------------------------------------------------------------ day
def _day(day: DayStudy, run: ContactRun | None, plan: ConstellationPlan | None) -> dict[str, Group]:
    """By group: "day/contacts", "day/relay" and the others that the study has."""
    found = {
        "day/contacts": _contacts(day),
        "day/line_of_sight": _line_of_sight(day),
        "day/assumptions": _assumptions(day),
        f"day/{_group_name(day.relay)}": _day_way(day.relay),
    }
    if day.direct is not None:
        found["day/passes"] = _passes(day.direct)
        found[f"day/{_group_name(day.direct)}"] = _day_way(day.direct)
    if run is not None:
        found["day/contact_run"] = _contact_run(run)
    if plan is not None:
        found["day/sessions"] = _sessions(plan)
    return {name: replace(each, attributes={"epoch": day.view.pair.epoch.text}) for name, each in found.items()}


def _group_name(way: Way) -> str:
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


def _day_way(way: Way) -> Group:
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


def _contact_run(run: ContactRun) -> Group:
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
