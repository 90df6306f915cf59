"""The section of the page on the fine-pointing loop: its sentences and tables, ready to be put down."""

import math
from collections.abc import Callable, Sequence
from typing import Any

from microrad.core.units import format_quantity
from microrad.loop.control import LoopMargins
from microrad.loop.fine_pointing import FinePointingStudy, Residual, Sine
from microrad.loop.fine_pointing.parts import DELAY
from microrad.mirror.geometry import StrokeBudget
from microrad.mirror.summary import unknown_dynamics
from microrad.report.fine_pointing import words
from microrad.report.fine_pointing.data import parameter_units, rms_by_source, sources
from microrad.report.plotting.figure import Figure
from microrad.report.quantities import angle, given_angle, micro, minus, percent, share_of_time

Row = dict[str, Any]


def fine_pointing_section(fine: FinePointingStudy, required: float, figures: Sequence[Figure]) -> dict[str, Any]:
    """What the template needs at a required pointing error (rad); its tables have microradians, as they say."""
    variants = [v for v in words.NAMES if any(v in each.simulated for each in fine.verified)]
    return {
        "met": fine.best.meets(required) and not unknown_dynamics(fine.scene.mirrors.table),
        "verdict": words.result(fine, required),
        "theory": words.theory(fine),
        "setting": setting(fine),
        "quantile": share_of_time(fine.quantile),
        "required": given_angle(required),
        "variants": [(v, words.NAMES[v]) for v in variants],
        "residuals": residual_rows(fine, variants, required),
        "limits": limits(fine),
        "designs": design_rows(fine),
        "sources": [words.source_name(name) for name in sources(fine.verified)],
        "by_source": source_rows(fine),
        "budget": budget(fine),
        "stroke_verdict": words.stroke(fine),
        "stroke": stroke(fine),
        "sines": sines(fine, required),
        "amplitude": given_angle(fine.scene.sine_amplitude_rad),
        "figures": figures,
    }


def setting(fine: FinePointingStudy) -> str:
    """What was simulated, in a sentence."""
    loop, table = fine.scene.loop, fine.scene.table
    rate = format_quantity(1.0 / loop.timing.period_s, "Hz")
    delay = format_quantity(loop.timing.delay_steps * loop.timing.step_s, "s")
    noise = given_angle(loop.optical.noise_rad)
    disturbances = words.listed([f"{each.name} {angle(each.rms_rad)}" for each in loop.disturbances[0]])
    return (
        f"Control at {rate} with {delay} of delay, sensor noise {noise} rms per axis and reading; disturbances, rms "
        f"per axis before the loop: {disturbances}. Simulated: {table.runs} runs of "
        f"{format_quantity(table.duration_s, 's')} each, the first {format_quantity(table.settle_s, 's')} left out, "
        f"seed {table.seed}. A design has to keep a modulus margin of {table.modulus_margin:g}."
    )


# ------------------------------------------------------------------------------------------------ numbers


def with_interval(residual: Residual) -> str:
    """A radial rms (µrad) with the half width of its interval, as many decimals as that has a meaning for."""
    value, half = 1e6 * residual.rms_rad, 1e6 * residual.rms_interval_rad
    if not (half > 0.0 and math.isfinite(half)):
        return micro(residual.rms_rad)
    decimals = min(3, max(0, -math.floor(math.log10(half))))
    return f"{value:.{decimals}f} ± {max(half, 10.0**-decimals):.{decimals}f}"


# ------------------------------------------------------------------------------------------------ controllers


def residual_rows(fine: FinePointingStudy, variants: Sequence[str], required_rad: float) -> list[Row]:
    """What each controller leaves, in theory and by variant of the mirror."""
    return [
        {
            "name": v.design.name,
            "best": v.design.name == fine.best.design.name,
            "theory": micro(v.theory.radial_rms_rad),
            "simulated": [_simulated(v.simulated.get(variant), required_rad) for variant in variants],
        }
        for v in fine.verified
    ]


def _simulated(residual: Residual | None, required_rad: float) -> Row:
    if residual is None:
        return {"rms": "", "quantile": "", "largest": "", "mark": ""}
    return {
        "rms": with_interval(residual),
        "quantile": micro(residual.quantile_rad),
        "largest": micro(residual.largest_rad),
        "mark": "PASS" if residual.quantile_rad <= required_rad else "FAIL",
    }


def limits(fine: FinePointingStudy) -> list[str]:
    """Limits met by controller and variant of the mirror, a line each."""
    return [
        f"{v.design.name}, {words.NAMES[variant]}: {words.limits_met(residual.shares)}"
        for v in fine.verified
        for variant, residual in v.simulated.items()
        if residual.shares
    ]


def design_rows(fine: FinePointingStudy) -> list[Row]:
    """What each controller was tuned to, its margins and what it is bound by."""
    units = parameter_units(fine)
    return [
        {
            "name": v.design.name,
            "best": v.design.name == fine.best.design.name,
            "inverse": v.design.inverse,
            "tuned": ", ".join(_value(name, value, units) for name, value in v.design.tuned.values.items()),
            "margins": _margins(v.design.tuned.margins),
            "bound_by": ", ".join(v.design.tuned.bound_by) or "nothing",
        }
        for v in fine.verified
    ]


def _value(name: str, value: float, units: dict[str, str]) -> str:
    unit = units.get(name, "")
    return minus(f"{name} {format_quantity(value, unit, 3) if unit else f'{value:.3g}'}")


def _margins(margins: LoopMargins) -> list[str]:
    """Modulus, gain (dB), phase (degrees), delay (µs), disk, bandwidth and crossover (Hz), in the table's order."""
    gain = 20.0 * math.log10(margins.gain_up)
    return [
        f"{margins.modulus:.2f}",
        _or(f"{gain:.1f}", gain, "any"),
        _or(f"{math.degrees(margins.phase_rad):.0f}", margins.phase_rad, "any"),
        _or(f"{1e6 * margins.delay_s:.0f}", margins.delay_s, "any"),
        f"{margins.disk:.2f}",
        f"{margins.bandwidth_hz:.3g}",
        _or(f"{margins.crossover_hz:.3g}", margins.crossover_hz, "none"),
    ]


def _or(text: str, value: float, instead: str) -> str:
    return text if math.isfinite(value) else instead


def source_rows(fine: FinePointingStudy) -> list[Row]:
    """Radial rms by controller and source in theory, after a row of what the disturbances are before the loop."""
    names = sources(fine.verified)
    open_loop: dict[str, float] = {}
    for each in (d for several in fine.scene.loop.disturbances for d in several):
        open_loop[each.name] = math.hypot(open_loop.get(each.name, 0.0), each.rms_rad)
    before = {"name": "before the loop", "cells": [micro(open_loop.get(n, math.nan)) for n in names], "total": ""}
    rows: list[Row] = [{**before, "total": micro(math.hypot(*open_loop.values())), "best": False}]
    for v in fine.verified:
        by_source = rms_by_source(v)
        cells = [micro(by_source.get(name, math.nan)) for name in names]
        best = v.design.name == fine.best.design.name
        rows.append({"name": v.design.name, "cells": cells, "total": micro(v.theory.radial_rms_rad), "best": best})
    return rows


# ------------------------------------------------------------------------------------------------ error budget


def budget(fine: FinePointingStudy) -> Row:
    """Parts alone, their combinations, and what the rest changes, with the sentences to it."""
    b = fine.budget
    total = math.fsum(part.rms_rad**2 for part in b.parts)
    theory = math.hypot(*(part.theory_rad for part in b.parts if math.isfinite(part.theory_rad)))
    return {
        "controller": b.controller,
        "parts": [
            {
                "name": words.source_name(part.name),
                "rms": micro(part.rms_rad),
                "theory": micro(part.theory_rad),
                "share": _variance_share(part.rms_rad**2, total),
            }
            for part in b.parts
        ],
        "totals": [
            ("Root sum square of the parts", micro(b.combined_rad), micro(theory)),
            ("All together, without hysteresis", micro(b.together_rad), ""),
            ("All together, the mission's mirror", micro(b.full_rad), ""),
        ],
        "differences": [
            {
                "name": d.name,
                "with": micro(d.with_rad),
                "without": micro(d.without_rad),
                "added": micro(d.added_rad),
            }
            for d in b.differences
        ],
        "sentences": budget_sentences(fine),
    }


def _variance_share(variance: float, total: float) -> str:
    share = 100.0 * variance / total if total else 0.0
    return "< 0.1 %" if 0.0 < share < 0.05 else f"{share:.1f} %" if share else "0 %"


def budget_sentences(fine: FinePointingStudy) -> list[str]:
    """Whether the parts make up the whole, and if not, where the loop is not linear."""
    b = fine.budget
    apart = percent(abs(b.together_rad / b.combined_rad - 1.0))
    sentences = [f"Without hysteresis the parts combine to what they leave together, to within {apart}."]
    whole = b.full_rad / b.combined_rad - 1.0
    if b.linear:
        sentences.append(f"With it they still do, to within {percent(abs(whole))}: the loop counts as linear.")
        return sentences
    adding = [d for d in b.differences if d.name != DELAY and d.added_rad > 0.01 * b.full_rad]
    where = words.listed([f"{d.name} adds {angle(d.added_rad)}" for d in adding])
    sentences.append(
        f"The full loop leaves {percent(abs(whole))} {'more' if whole > 0.0 else 'less'} than the parts combine "
        f"to, so it is not linear (10 % is the limit){': ' + where if where else ''}."
    )
    return sentences


# ------------------------------------------------------------------------------------------------ stroke


def stroke(fine: FinePointingStudy) -> Row:
    """The stroke budgets side by side, a column for each output of the mirror with and without the point-ahead."""
    ours = fine.scene.own_stroke
    groups = (
        ("Point-ahead on the mirror", fine.scene.stroke),
        ("Point-ahead elsewhere", fine.scene.stroke_without_point_ahead),
    )
    axes = [axis for _, several in groups for axis in several]
    rows: list[Row] = [
        {"name": line.name, "cells": [micro(axis.lines[i].value) for axis in axes], "total": False}
        for i, line in enumerate(axes[0].lines)
    ]
    rows += [_stroke_row(name, axes, show) for name, show in _stroke_rows(axes[0].travel_angle)]
    return {
        "groups": [(f"{name}{' (this mission)' if several is ours else ''}", len(several)) for name, several in groups],
        "axes": [axis.name for axis in axes],
        "rows": rows,
        "notes": [(line.name, line.basis.partition(";")[0], line.source) for line in axes[0].lines],
    }


def _stroke_row(name: str, axes: Sequence[StrokeBudget], show: Callable[[StrokeBudget], str]) -> Row:
    return {"name": name, "cells": [show(axis) for axis in axes], "total": name.startswith(("Total", "Margin"))}


def _both(worst: float, rss: float) -> str:
    return f"{micro(worst)} / {micro(rss)}"


def _yes(worst: bool, rss: bool) -> str:
    return f"{'yes' if worst else 'no'} / {'yes' if rss else 'no'}"


def _stroke_rows(angle: str) -> tuple[tuple[str, Callable[[StrokeBudget], str]], ...]:
    """Rows below the lines: name, and what a column shows there, worst case over root sum square."""
    return (
        ("Total at the line of sight", lambda a: _both(a.total_rad, a.total_rss_rad)),
        (f"Needed at the mirror, {angle} angle", lambda a: _both(a.needed_rad, a.needed_rss_rad)),
        ("Available there: half of the usable travel", lambda a: micro(a.available_rad)),
        ("Margin", lambda a: _both(a.margin_rad, a.margin_rss_rad)),
        ("Fits", lambda a: _yes(a.fits, a.fits_rss)),
        ("Largest telescope magnification", _magnification),
    )


def _magnification(axis: StrokeBudget) -> str:
    values = (axis.largest_magnification, axis.largest_magnification_rss)
    return " / ".join("any" if math.isinf(v) else f"{v:.2f}" for v in values)


# ------------------------------------------------------------------------------------------------ sines


def sines(fine: FinePointingStudy, required_rad: float) -> Row:
    """Controllers by sine: rms and quantile, a group of columns for each variant of the mirror."""
    found: dict[tuple[str, str, float], Sine] = {(s.controller, s.variant, s.freq_hz): s for s in fine.sines}
    columns = list(dict.fromkeys((s.variant, s.freq_hz) for s in fine.sines))
    variants = list(dict.fromkeys(variant for variant, _ in columns))
    return {
        "groups": [(words.NAMES[v], sum(variant == v for variant, _ in columns)) for v in variants],
        "frequencies": [f"{freq:g} Hz" for _, freq in columns],
        "rows": [
            {
                "name": name,
                "best": name == fine.best.design.name,
                "cells": [_sine(found.get((name, *column)), required_rad) for column in columns],
            }
            for name in dict.fromkeys(s.controller for s in fine.sines)
        ],
        "sentence": words.tracked(fine, required_rad),
    }


def _sine(sine: Sine | None, required_rad: float) -> Row:
    if sine is None:
        return {"rms": "", "quantile": "", "mark": ""}
    met = sine.quantile_rad <= required_rad
    return {
        "rms": micro(sine.rms_rad),
        "quantile": micro(sine.quantile_rad),
        "mark": "PASS" if met else "FAIL",
    }
