"""The numbers of a study as netCDF: arrays with their unit and meaning, in groups."""

import io
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import h5netcdf
import h5py
import numpy as np

from microrad.core.arrays import Floats
from microrad.core.labelled import TEXT, Group, Variable, variables
from microrad.link.error_budget.assembly import Judged, PointingErrorBudget
from microrad.loop.controller_study import FinePointingStudy, Residual
from microrad.loop.paper_cases import Run
from microrad.loop.pointing_loop.ensemble import COUNTERS, axis_names
from microrad.orbit import Contact
from microrad.orbit.constellation import ConstellationPlan
from microrad.orbit.day import DayStudy, Encounter, Way
from microrad.report.fine_pointing.data import margins, rms_by_source, sources
from microrad.study.contact_run import ContactRun
from microrad.study.study import Study

_SPECTRUM = "rad^2/Hz"


def study_netcdf(study: Study) -> bytes:
    """The content of results.nc.

    It has margin map, hysteresis loops, traces, fine-pointing loop, the budget of pointing errors and the day; each
    variable with its unit.
    """
    groups = {"margin_map": _map(study), "link_performance": _performance(study), **_loops(study)}
    for run in study.runs:
        name = f"{run.mirror} {run.controller} {run.freq_hz:g}_hz".replace(" + ", "_").replace(" ", "_").lower()
        groups[f"tracking/{name}"] = _trace(run)
    if study.fine_pointing is not None:
        groups |= _fine_pointing(study.fine_pointing)
    if study.error_budget is not None:
        groups |= _pointing_errors(study.error_budget)
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
                made.attrs.update(of.attributes)
    return content.getvalue()


# ------------------------------------------------------------------------------------------------ study
def _trace(run: Run) -> Group:
    t, c = run.trace, run.trace.counts
    data = variables(
        "time",
        reference=("rad", "pointing reference", t.reference_rad[:, 0]),
        output=("rad", "mirror output at the line of sight", t.output_rad[:, 0]),
        command=("V", "controller output about the bias", t.command_v[:, 0]),
        drive=("V", "amplifier output over its gain, about the bias", t.drive_v[:, 0]),
    )
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
    return Group(data, variables("time", time=("s", "time", t.time_s)), attributes)


def _map(study: Study) -> Group:
    f = study.margin_map
    rates = variables("data_rate", data_rate=("bit/s", "data rate", f.data_rate_bit_s))
    errors = variables("pointing_error", pointing_error=("rad", "pointing error", f.pointing_error_rad))
    margin = ("dB", "margin of the communication link", f.margin_db)
    return Group(variables("data_rate pointing_error", margin=margin), rates | errors)


def _loops(study: Study) -> dict[str, Group]:
    bias = study.file.mission.mirror.bias_v
    return {
        f"hysteresis_loops/{loop.freq_hz:g}_hz": Group(
            variables(
                "sample",
                drive=("V", "drive", loop.drive_v + bias),
                output=("rad", "output about the bias", loop.output_rad),
                hysteresis=("rad", "hysteresis h", loop.hysteresis_rad),
            ),
            attributes={"frequency_hz": loop.freq_hz, "width": loop.width, "rate_clamped_samples": loop.clamped},
        )
        for loop in study.loops
    }


def _performance(study: Study) -> Group:
    """The communication link under each simulated residual, one entry a case."""
    penalty = "power that the pointing error costs without a code; nan where the receiver's curve is not known"
    half = "half angle at 1/e2 with the most power at the outage loss"
    data = variables(
        "case",
        study.performance.cases,
        source=(TEXT, "pointing error", "source"),
        controller=(TEXT, "controller", "controller"),
        mirror=(TEXT, "variant of the mirror", "mirror"),
        mean_loss=("dB", "loss of the mean power by pointing", "mean_loss_db"),
        outage_loss=("dB", "pointing loss exceeded for the outage's share of time", "outage_loss_db"),
        uncoded_penalty=("dB", penalty, "uncoded_penalty_db"),
        margin=("dB", "margin at the outage loss", "margin_db"),
        outage=("1", "share of the time with a margin below 0 dB", "outage"),
        below_required=("1", "share of the time below the required margin", "short"),
        data_rate=("bit/s", "data rate with the required margin there", "data_rate_bit_s"),
        best_half_angle=("rad", half, "best.half_angle_rad"),
    )
    return Group(data, attributes={"outage": study.performance.outage})


# ------------------------------------------------------------------------------------------------ fine pointing
def _fine_pointing(fine: FinePointingStudy) -> dict[str, Group]:
    """Spectra, residuals, theory by source, margins, error budget and sines of the fine-pointing loop."""
    makers = (_spectra, _residuals, _theory, _loop_margins, _error_budget, _sines)
    names = ("spectra", "residuals", "theory", "margins", "error_budget", "sines")
    return {f"fine_pointing/{name}": make(fine) for name, make in zip(names, makers, strict=True)}


def _controllers(fine: FinePointingStudy) -> dict[str, Variable]:
    return variables("controller", fine.verified, controller=(TEXT, "controller", "design.name"))


def _axes(fine: FinePointingStudy) -> dict[str, Variable]:
    return axis_names(fine.scene.loop.axes)


def _spectra(fine: FinePointingStudy) -> Group:
    before = "one-sided spectrum of the disturbances of an axis before the loop, lines left out"
    data = variables("frequency", before=(_SPECTRUM, before, fine.disturbed_rad2_hz)) | variables(
        "controller frequency axis",
        fine.verified,
        residual=(_SPECTRUM, "one-sided spectrum of the simulated residual, mission's mirror", "spectrum_rad2_hz"),
        predicted=(_SPECTRUM, "one-sided spectrum of the residual in linear theory", "predicted_rad2_hz"),
    )
    freq = variables("frequency", frequency=("Hz", "frequency", fine.freq_hz))
    return Group(data, {**_controllers(fine), **freq, **_axes(fine)})


def _residuals(fine: FinePointingStudy) -> Group:
    variants, limits = [*dict.fromkeys(name for v in fine.verified for name in v.simulated)], [*COUNTERS]
    table = [[v.simulated.get(name) for name in variants] for v in fine.verified]

    def gathered(pick: Callable[[Residual], Any], missing: Any = math.nan) -> Floats:
        return np.array([[missing if r is None else pick(r) for r in row] for row in table], dtype=float)

    shares = gathered(lambda r: [r.shares.get(name, 0.0) for name in limits], [math.nan] * len(limits))
    axis_rms = gathered(lambda r: r.axis_rms_rad, [math.nan] * fine.scene.loop.axes)
    at = f"radial error that {fine.quantile:g} of the time stays below"
    interval = "half width of the 99 % interval of the radial rms over the runs"
    data = variables(
        "controller mirror",
        rms=("rad", "radial rms", gathered(lambda r: r.rms_rad)),
        rms_interval=("rad", interval, gathered(lambda r: r.rms_interval_rad)),
        quantile=("rad", at, gathered(lambda r: r.quantile_rad)),
        largest=("rad", "largest radial error", gathered(lambda r: r.largest_rad)),
    )
    data |= variables("controller mirror axis", axis_rms=("rad", "rms by axis", axis_rms))
    met = "share of samples or plant steps at which a limit was met"
    data |= variables("controller mirror limit", share=("1", met, shares))
    names = _controllers(fine) | variables("mirror", mirror=(TEXT, "variant of the mirror", variants))
    names |= _axes(fine) | variables("limit", limit=(TEXT, "limit", limits))
    return Group(data, names, {"quantile": fine.quantile, "best": fine.best.design.name})


def _theory(fine: FinePointingStudy) -> Group:
    names = sources(fine.verified)
    parts = [rms_by_source(v) for v in fine.verified]
    by_source = [[part.get(name, math.nan) for name in names] for part in parts]
    total = variables("controller", fine.verified, rms=("rad", "radial rms of all sources", "theory.radial_rms_rad"))
    data = variables("controller source", rms_by_source=("rad", "radial rms that one source leaves", by_source))
    bound = ("rad", "radial rms below which no linear controller comes", fine.optimum_rad)
    source = variables("source", source=(TEXT, "source of error", names))
    return Group({**data, **total, **variables("", bound=bound)}, _controllers(fine) | source)


def _loop_margins(fine: FinePointingStudy) -> Group:
    data = variables(
        "controller",
        [margins(v.design) for v in fine.verified],
        modulus=("1", "modulus margin, min |1 + L|", lambda m: m["modulus"]),
        gain_up_db=("dB", "gain margin upwards", lambda m: m["gain_up_db"]),
        phase_rad=("rad", "phase margin", lambda m: m["phase_rad"]),
        delay_s=("s", "delay margin", lambda m: m["delay_s"]),
        disk=("1", "symmetric disk margin, 2 / max |S - T|", lambda m: m["disk"]),
        bandwidth_hz=("Hz", "lowest frequency with |S| = 1", lambda m: m["bandwidth_hz"]),
        crossover_hz=("Hz", "highest frequency with |L| = 1", lambda m: m["crossover_hz"]),
    )
    return Group(data, _controllers(fine))


def _error_budget(fine: FinePointingStudy) -> Group:
    b = fine.budget
    data = variables(
        "part",
        b.parts,
        rms=("rad", "radial rms of one part alone, simulated without hysteresis", "rms_rad"),
        theory=("rad", "radial rms of one part alone in linear theory", "theory_rad"),
    )
    data |= variables(
        "",
        combined=("rad", "root sum square of the parts", b.combined_rad),
        together=("rad", "radial rms of all parts together, without hysteresis", b.together_rad),
        full=("rad", "radial rms of the full loop", b.full_rad),
    )
    without = ("rad", "radial rms of the full loop but for what is left out", "without_rad")
    changed = {"with": ("rad", "radial rms of the full loop", "with_rad"), "without": without}
    data |= variables("left_out", b.differences, **changed)
    names = variables("part", b.parts, part=(TEXT, "part of the error", "name"))
    names |= variables("left_out", b.differences, left_out=(TEXT, "part that is left out", "name"))
    return Group(data, names, {"controller": b.controller})


def _sines(fine: FinePointingStudy) -> Group:
    """One entry a run: not every controller need have run on every mirror."""
    data = variables(
        "run",
        fine.sines,
        controller=(TEXT, "controller", "controller"),
        mirror=(TEXT, "variant of the mirror", "variant"),
        frequency=("Hz", "frequency of the sine on axis x", "freq_hz"),
        rms=("rad", "radial rms", "rms_rad"),
        quantile=("rad", f"radial error that {fine.quantile:g} of the time stays below", "quantile_rad"),
    )
    return Group(data)


# ------------------------------------------------------------------------------------------------ pointing errors
def _pointing_errors(budget: PointingErrorBudget) -> dict[str, Group]:
    """Requirements with their totals and distributions, every source under each of them, and spectra."""
    judged, curves = budget.judged, "requirement size"
    data = variables(
        "requirement",
        judged,
        index=(TEXT, "index", "total.required.index.kind"),
        confidence=("1", "share that keeps the limit", "total.required.confidence"),
        limit=("rad", "limit", "total.required.limit_rad"),
        by_rules=("rad", "total by the rules of ECSS-E-ST-60-10C", "total.by_rules_rad"),
        by_distribution=("rad", "total by the full distribution", "total.quantile_rad"),
    )
    data |= variables(
        curves, judged, error=("rad", "size of an error", "size_rad"), beyond=("1", "share of larger ones", "beyond")
    )
    names = variables("requirement", judged, requirement=(TEXT, "requirement", "name"))
    found = {"requirements": Group(data, names), "sources": _sources_of_errors(judged)}
    if budget.spectra:
        density = ("rad^2/Hz", "one-sided spectrum of all axes together", [*budget.spectra.values()])
        axes = variables("source", source=(TEXT, "source", [*budget.spectra]))
        axes |= variables("frequency", frequency=("Hz", "frequency", budget.freq_hz))
        found["spectra"] = Group(variables("source frequency", density=density), axes)
    return {f"error_budget/{name}": group for name, group in found.items()}


def _sources_of_errors(judged: Sequence[Judged]) -> Group:
    """One entry a source and requirement: sources that are correlated may stand together for one of them alone."""
    allowed = "how many times as large it may be until the limit is met, inf for any"
    data = variables(
        "entry",
        [share for each in judged for share in each.shares],
        source=(TEXT, "source", "name"),
        kind=(TEXT, "class", "contribution.kind"),
        mean=("rad", "length of its mean", lambda share: math.hypot(*share.mean_rad)),
        deviation=("rad", "length of its standard deviations", lambda share: math.hypot(*share.sigma_rad)),
        contribution=("rad", "part of the total by the distribution", "part_rad"),
        weight=("1", "growth of the total for that of the source, both as a share", "growth"),
        without=("rad", "total without it", "without_rad"),
        may_be=("1", allowed, "allowed"),
    )
    of = [each.name for each in judged for _ in each.shares]
    return Group(data | variables("entry", requirement=(TEXT, "requirement", of)))


# ------------------------------------------------------------------------------------------------ day
def _day(day: DayStudy, run: ContactRun | None, plan: ConstellationPlan | None) -> dict[str, Group]:
    """By group: "day/contacts", "day/relay" and the others that the study has."""
    relay, direct = (None if way is None else way.name.replace(" ", "_") for way in (day.relay, day.direct))
    found = {"contacts": _contacts(day), "line_of_sight": _line_of_sight(day), "assumptions": _assumptions(day)}
    found[f"{relay}"] = _day_way(day.relay)
    if day.direct is not None:
        found |= {"passes": _passes(day.direct), f"{direct}": _day_way(day.direct)}
    if day.optical is not None:
        found |= {"optical_passes": _passes(day.optical), "optical_downlink": _day_way(day.optical)}
    found |= {} if run is None else {"contact_run": _contact_run(run)}
    found |= {} if plan is None else {"sessions": _sessions(plan)}
    epoch = {"epoch": day.view.pair.epoch.text}
    return {f"day/{name}": replace(each, attributes=epoch) for name, each in found.items()}


def _spans(contacts: Sequence[Contact]) -> dict[str, Variable]:
    return variables(
        "contact",
        contacts,
        start=("s", "begin, since the epoch", "start_s"),
        end=("s", "end, since the epoch", "end_s"),
        begins=(TEXT, "what begins it", "begins"),
        ends=(TEXT, "what ends it", "ends"),
    )


def _contacts(day: DayStudy) -> Group:
    data = variables(
        "contact",
        day.encounters,
        range_least=("m", "smallest range", "range_least_m"),
        range_most=("m", "largest range", "range_most_m"),
        point_ahead=("rad", "largest point-ahead angle", "point_ahead_most_rad"),
        rate=("rad/s", "largest angular rate of the line of sight", "rate_most_rad_s"),
        acceleration=("rad/s^2", "largest change of that rate", "acceleration_most_rad_s2"),
        doppler=("Hz", "largest Doppler shift in magnitude", "doppler_most_hz"),
        could_carry=("bit", "data that it could carry within the span, mean of the runs", day.relay.carried_bit),
    )
    return Group({**_spans([e.contact for e in day.encounters]), **data})


def _line_of_sight(day: DayStudy) -> Group:
    """Every contact in time, one after the other."""
    wavelength = day.data.table.wavelength_m

    def joined(pick: Callable[[int, Encounter], Any]) -> Floats:
        return np.concatenate([np.zeros(0), *(pick(k, e) for k, e in enumerate(day.encounters))])

    def sight(name: str) -> Floats:
        return joined(lambda _, e: getattr(e.sight, name))

    number = joined(lambda k, e: np.full(e.sight.time_s.size, float(k + 1)))
    doppler = joined(lambda _, e: e.sight.doppler_hz(wavelength))
    data = variables(
        "sample",
        contact=("1", "number of the contact in the span, from 1", number),
        time=("s", "time since the epoch", sight("time_s")),
        range=("m", "range", sight("range_m")),
        range_rate=("m/s", "range rate, positive while they recede", sight("range_rate_m_s")),
        doppler=("Hz", "frequency received less sent", doppler),
        rate=("rad/s", "angular rate of the line of sight", sight("rate_rad_s")),
        acceleration=("rad/s^2", "change of that rate, as a vector", sight("acceleration_rad_s2")),
        point_ahead=("rad", "point-ahead angle", sight("point_ahead_rad")),
    )
    return Group(data)


def _passes(way: Way) -> Group:
    carried = ("bit", "data that it could carry within the span", way.carried_bit)
    own = variables("contact", station=(TEXT, "ground station", way.stations), could_carry=carried)
    return Group({**_spans(way.contacts), **own})


def _day_way(way: Way) -> Group:
    h = way.history
    data = variables(
        "moment",
        time=("s", "time since the epoch; linear from one moment to the next", h.time_s),
        generated=("bit", "made by the instrument so far", h.generated_bit),
        delivered=("bit", "sent so far", h.delivered_bit),
        stored=("bit", "on board", h.stored_bit),
        lost=("bit", "lost so far for want of room", h.lost_bit),
    )
    data |= variables(
        "",
        could_carry=("bit", "what its contacts could carry, mean of the runs", way.capacity_bit),
        latency_median=("s", "median latency of the data kept, all runs", way.median_s),
        latency_99_percent=("s", "latency within which 99 % of it arrived", way.slow_s),
    )
    return Group(data)


def _assumptions(day: DayStudy) -> Group:
    found: dict[str, tuple[str, str, Any]] = {}
    keys = [("relay_bit", "bit"), ("direct_bit", "bit"), ("relay_slow_s", "s"), ("direct_slow_s", "s")]
    keys += [] if day.optical is None else [("optical_bit", "bit"), ("optical_slow_s", "s")]
    for side in ("low", "high"):
        found[side] = (TEXT, f"{side} side of the change", side)
        for key, unit in keys:
            name = key.rpartition("_")[0].replace("slow", "latency_99_percent")
            found[f"{name}_{side}"] = (unit, f"{name.replace('_', ' ')} with the {side} side", f"at_{side}.{key}")
    names = variables("assumption", day.swings, assumption=(TEXT, "what is changed", "name"))
    return Group(variables("assumption", day.swings, **found), names)


def _contact_run(run: ContactRun) -> Group:
    data = variables(
        "transition",
        run.log,
        state=(TEXT, "state that is left", "state"),
        to=(TEXT, "state that follows", "to"),
        cause=(TEXT, "why", "cause"),
        time=("s", "time since the epoch", "time_s"),
    )
    data |= variables(
        "window",
        run.windows,
        window_start=("s", "begin of the window, since the epoch", "start_s"),
        range=("m", "range", "range_m"),
        point_ahead=("rad", "point-ahead angle", "point_ahead_rad"),
        rate=("rad/s", "angular rate of the line of sight", "rate_rad_s"),
        rms=("rad", "radial rms of the pointing error", "rms_rad"),
        largest=("rad", "largest radial pointing error", "largest_rad"),
        lowest_margin=("dB", "lowest margin of the communication link", "lowest_margin_db"),
    )
    return Group(data)


def _sessions(plan: ConstellationPlan) -> Group:
    data = variables(
        "session",
        plan.planned,
        satellite=(TEXT, "satellite", "satellite"),
        relay=(TEXT, "relay", "relay"),
        start=("s", "begin, since the epoch", "start_s"),
        locked=("s", "from when data flow, since the epoch", "locked_s"),
        end=("s", "end, since the epoch", "end_s"),
        data_rate=("bit/s", "data rate", "rate_bit_s"),
        volume=("bit", "volume", "volume_bit"),
    )
    return Group(data)
