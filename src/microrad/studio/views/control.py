"""What the control page shows of a controller: margins as rows, responses by frequency and in time as plots."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from microrad.core.arrays import Floats
from microrad.core.units import UnitError, format_quantity, parse_quantity
from microrad.lab.live_fit import extremes
from microrad.studio.views.controllers import PID, PID_INVERSE, WITH, WITHOUT, Answers, Ask, Controller, Curve
from microrad.studio.views.plots import BLACK, BLUE, GREEN, GREY, VERMILION, Plot, decades, empty, marker_line, plot

SHOWN = {"both": (WITH, WITHOUT), "with": (WITH,), "without": (WITHOUT,)}
"""What the switch of the hysteresis shows."""

_STYLES = {WITH: (VERMILION, "solid"), WITHOUT: (BLUE, "dash")}
_POINTS = 1200
_LEAST = 1e-4  # of what is drawn on a logarithmic axis


class AskError(ValueError):
    """Something typed that no loop can be asked; the message names the field."""


def ask_of(step: str, amplitude: str, frequency: str, rate_hz: float) -> Ask:
    """Step, amplitude and frequency as they are typed, for a loop of this rate. Raises `AskError`."""
    return Ask(_angle("step", step), _angle("amplitude of the sine", amplitude), _frequency(frequency, rate_hz))


def _angle(name: str, typed: str) -> float:
    return _quantity(name, typed, "rad", 1e-9, 0.1)


def _frequency(typed: str, rate_hz: float) -> float:
    """The frequency of a sine that the samples of the loop can tell from a slower one."""
    found = _quantity("frequency of the sine", typed, "Hz", 0.1, 10_000.0)
    if found < 0.5 * rate_hz:
        return found
    half, rate = format_quantity(0.5 * rate_hz, "Hz"), format_quantity(rate_hz, "Hz")
    raise AskError(
        f"frequency of the sine: {typed.strip()} is not below {half}, half the rate of the loop, {rate}, which would "
        "take it for a slower one; type one below"
    )


def _quantity(name: str, typed: str, unit: str, least: float, most: float) -> float:
    try:
        found = parse_quantity(typed.strip(), unit)
    except UnitError as error:
        raise AskError(f"{name}: {error}") from None
    if not least <= found <= most:
        bounds = f"{format_quantity(least, unit)} to {format_quantity(most, unit)}"
        raise AskError(f"{name}: {typed.strip()} is outside {bounds}; type one between")
    return found


# --------------------------------------------------------------------------------------------------------------- words
def margin_rows(of: Controller) -> list[tuple[str, str]]:
    """The margins in words, the modulus against what is asked for."""
    m = of.margins
    asked = "" if math.isnan(of.asked_modulus) else f" (asked for: {of.asked_modulus:g})"
    rows = [
        ("Modulus margin, least |1 + L|", f"{m['modulus']:.3f}{asked}"),
        ("Gain margin", _gain(m["gain"])),
        ("Phase margin", "none" if math.isinf(m["phase"]) else f"{math.degrees(m['phase']):.1f}°"),
        ("Delay margin", _told(m["delay"], "s")),
        ("Crossover, |L| = 1", _told(m["crossover"], "Hz")),
        ("Bandwidth, |S| = 1", _told(m["bandwidth"], "Hz")),
        ("Largest |S|", f"{m['peak']:.3f} ({20 * math.log10(m['peak']):.2f} dB)"),
    ]
    if math.isfinite(of.residual_rad):
        rows.append(("Residual of an axis, rms, linear", _told(of.residual_rad, "rad")))
    return rows


def _gain(factor: float) -> str:
    return "none" if math.isinf(factor) else f"{factor:.3g} ({20 * math.log10(factor):.1f} dB)"


def _told(value: float, unit: str) -> str:
    return "none" if not math.isfinite(value) else format_quantity(float(f"{value:.4g}"), unit)


def value_rows(of: Controller) -> list[tuple[str, str]]:
    """What the controller was tuned to."""
    return [
        (f"{name[:1].upper()}{name[1:]}", f"{value:.5g} {unit}".rstrip()) for name, (value, unit) in of.values.items()
    ]


def notes(of: Controller) -> tuple[str, ...]:
    """What has to be known to read the numbers."""
    told = []
    if of.name in (PID, PID_INVERSE):
        told.append(
            "The gains of [control] as they stand in the mission: this loop is not tuned, and nothing shakes it."
        )
    if of.bound_by:
        told.append(f"What keeps its residual from being smaller: {', '.join(of.bound_by)}.")
    if of.sensitivity is None:
        told.append("The optical sensor is slower than the control: the loop has no response by frequency of its own.")
    return (*told, *of.warnings)


def table_row(of: Controller) -> dict[str, Any]:
    """The controller as a row of the table of all."""
    m = of.margins
    return {
        "name": of.name,
        "residual": _told(of.residual_rad, "rad") if math.isfinite(of.residual_rad) else "not computed",
        "modulus": f"{m['modulus']:.3f}",
        "gain": _gain(m["gain"]),
        "phase": f"{math.degrees(m['phase']):.1f}°" if math.isfinite(m["phase"]) else "none",
        "bandwidth": _told(m["bandwidth"], "Hz"),
    }


def waiting_row(name: str, words: str = "not looked at yet") -> dict[str, Any]:
    """A row of the table for a controller of which nothing is known."""
    return {"name": name, "residual": words, "modulus": "", "gain": "", "phase": "", "bandwidth": ""}


def answer_words(curves: dict[str, Curve], what: str, field_of_view_rad: float = math.inf) -> str:
    """Rms and peak of the error of each variant in a sentence, and one on a sensor that has lost sight of it."""
    told = [
        f"{variant} {format_quantity(float(f'{c.rms_rad:.3g}'), 'rad')} rms, at most "
        f"{format_quantity(float(f'{c.peak_rad:.3g}'), 'rad')}"
        for variant, c in curves.items()
    ]
    words = f"{what}: {'; '.join(told)}." if told else ""
    if not any(c.peak_rad > field_of_view_rad for c in curves.values()):
        return words
    view = format_quantity(field_of_view_rad, "rad")
    return f"{words} The sensor sees errors up to {view}: beyond, it holds its last reading, and the loop does not act."


# ------------------------------------------------------------------------------------------------ plots by frequency
def sensitivity_plot(of: Controller) -> Plot:
    """|S|: what the loop leaves of a disturbance at each frequency, below the inverse of the margin asked for."""
    if of.sensitivity is None:
        return empty("No response by frequency.")
    traces = [_line(of.freq_hz, of.sensitivity, "|S|", VERMILION)]
    if math.isfinite(of.asked_modulus):
        ends = of.freq_hz[[0, -1]]
        ceiling = np.full(2, 1.0 / of.asked_modulus)
        traces.append(_line(ends, ceiling, f"1 / modulus margin asked for ({of.asked_modulus:g})", BLACK, "dash"))
    return _by_frequency(of, traces, "|S|, error over disturbance", "bandwidth")


def gain_plot(of: Controller) -> Plot:
    """|L|: the loop gain."""
    if of.loop_gain is None:
        return empty("No response by frequency.")
    return _by_frequency(of, [_line(of.freq_hz, of.loop_gain, "|L|", BLUE)], "|L|, loop gain", "crossover")


def _by_frequency(of: Controller, traces: list[dict[str, Any]], title: str, mark: str) -> Plot:
    values = np.concatenate([np.asarray(each["y"], dtype=float) for each in traces])
    low, high = max(float(np.min(values)), _LEAST), float(np.max(values))
    at = of.margins[mark]
    traces.append(_line(of.freq_hz[[0, -1]], np.ones(2), "1", GREY, "dot"))
    if math.isfinite(at) and at > 0.0:
        traces.append(marker_line(at, f"{mark} {_told(at, 'Hz')}", GREEN, "dashdot", (low, high)))
    places, words = decades(float(of.freq_hz[0]), float(of.freq_hz[-1]), "Hz")
    tens = {10.0**p: word for p, word in zip(places, words, strict=True) if abs(p - round(p)) < 1e-9}
    ticks = {"tickmode": "array", "tickvals": [*tens], "ticktext": [*tens.values()], "tickangle": 0}
    x = {"title": "frequency", "type": "log", **ticks}
    y = {
        "title": title,
        "type": "log",
        "range": [math.log10(low), math.log10(high) + 0.1],
        "dtick": 1,
        "exponentformat": "power",
    }
    return plot(traces, x, y)


# ---------------------------------------------------------------------------------------------------- plots over time
def step_plot(answers: Answers) -> Plot:
    """The line of sight behind a step of the reference."""
    if not answers.step:
        return empty("Nothing was asked.")
    first = next(iter(answers.step.values()))
    traces = [_line(_ms(first), 1e6 * first.wanted_rad, "wanted", GREY, "dot")]
    traces += [_styled(_ms(c), 1e6 * c.found_rad, v) for v, c in answers.step.items()]
    return plot(traces, {"title": "time (ms)"}, _micro("line of sight, axis x"))


def sine_plot(answers: Answers) -> Plot:
    """The error of axis x while the loop follows a sine, settled; the time is that since it has settled."""
    traces = [_styled(_ms(c), 1e6 * c.error_rad[:, 0], v) for v, c in answers.sine.items()]
    return plot(traces, {"title": "time (ms)"}, _micro("error, axis x"))


def jitter_plot(answers: Answers) -> Plot:
    """The error of axis x under everything that disturbs the loop."""
    if not answers.jitter:
        return empty("Nothing disturbs this loop.")
    traces = [_styled(_s(c), 1e6 * c.error_rad[:, 0], v, 0.8) for v, c in answers.jitter.items()]
    return plot(traces, {"title": "time (s)"}, _micro("error, axis x"))


def motion_plot(answers: Answers) -> Plot:
    """What the mirror has to follow on axis x, and what it does: the closed loop's trace."""
    if not answers.jitter:
        return empty("Nothing disturbs this loop.")
    first = next(iter(answers.jitter.values()))
    assert first.disturbance_rad is not None  # a loop that is shaken says by what
    traces = [_line(_s(first), 1e6 * first.disturbance_rad[:, 0], "to be followed", GREY, width=4.0)]
    traces += [_styled(_s(c), 1e6 * c.found_rad, v) for v, c in answers.jitter.items()]
    return plot(traces, {"title": "time (s)"}, _micro("angle, axis x"))


def drive_plot(of: Controller, curves: dict[str, Curve], over: str = "ms") -> Plot:
    """The drive of the first actuator from the bias, with the amplifier's limits and the identified range."""
    if not curves:
        return empty("Nothing was asked.")
    time = _ms if over == "ms" else _s
    traces = [_styled(time(c), c.drive_v[:, 0], v) for v, c in curves.items()]
    ends = time(next(iter(curves.values())))[[0, -1]]
    if of.identified_v != of.limits_v:
        traces += _pair(ends, of.identified_v, "range of the identification", GREY, "dot")
    traces += _pair(ends, of.limits_v, "amplifier's limits", BLACK, "dash")
    return plot(traces, {"title": f"time ({over})"}, {"title": "drive from the bias (V)"})


def _pair(ends: Floats, limits: tuple[float, float], name: str, colour: str, dash: str) -> list[dict[str, Any]]:
    found = [each for each in limits if math.isfinite(each)]
    lines = [_line(ends, np.full(2, each), name, colour, dash) for each in found]
    for each in lines[1:]:
        each["showlegend"] = False
    return [{**each, "legendgroup": name} for each in lines]


def _micro(title: str) -> dict[str, Any]:
    """An axis of angles; its ticks are numbers, and not "100k" of a unit that has a prefix already."""
    return {"title": f"{title} (µrad)", "exponentformat": "none"}


def _styled(x: Floats, y: Floats, variant: str, width: float = 1.6) -> dict[str, Any]:
    colour, dash = _STYLES[variant]
    return _line(x, y, variant, colour, dash, width)


def _line(x: Floats, y: Floats, name: str, colour: str, dash: str = "solid", width: float = 1.6) -> dict[str, Any]:
    rows = extremes([y], _POINTS)
    line = {"color": colour, "dash": dash, "width": width}
    return {
        "type": "scatter",
        "mode": "lines",
        "x": _short(x[rows]),
        "y": _short(y[rows]),
        "name": name,
        "line": line,
    }


def _short(values: Sequence[float] | Floats) -> list[float]:
    return [float(f"{value:.6g}") for value in values]


def _ms(curve: Curve) -> Floats:
    return np.asarray(1e3 * (curve.time_s - curve.time_s[0]))


def _s(curve: Curve) -> Floats:
    return np.asarray(curve.time_s)
