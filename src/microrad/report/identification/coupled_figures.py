"""The figures of an identification of several channels: error over parameters, response, amplitude, error by band.

As for one axis, measured is blue and modelled is vermilion and dashed.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from microrad.core.arrays import Floats
from microrad.lab.identify.coupled import Candidate, CoupledIdentification
from microrad.lab.identify.linear.amplitude import AmplitudeDependence
from microrad.report.identification import coupled_words as words
from microrad.report.identification.figures import banded_rms
from microrad.report.plotting.figure import Figure
from microrad.report.plotting.palette import BLACK, BLUE, GREEN, ORANGE, SKY, VERMILION, thinned_by_logarithm
from microrad.report.plotting.sheet import Axis, Legend, Line, Rule, Sheet, Span, between, grid, shortened
from microrad.report.quantities import counted, quantity

MOST = 4
"""Outputs, and drives, that a figure has panels for."""
_WIDTH = 8.2
_STRETCHES = 110  # of the frequencies of a panel, each with its lowest and highest value
_FAR = 20.0  # times below the best model, noise would leave no room for the models
_NAME = 16  # characters of a channel's name above a panel
_KINDS: dict[str, dict[str, Any]] = {
    "per axis": {"colour": SKY, "marker": "s"},
    "coupled linear": {"colour": BLUE, "marker": "o"},
    "hysteretic stiffness": {"colour": VERMILION, "marker": "^"},
}


def coupled_figures(found: CoupledIdentification) -> dict[str, Figure]:
    """All figures by name; those that the recordings cannot fill are left out."""
    number = words.drawn_amplitude(found)
    figures = [error_over_parameters(found)]
    figures += [] if number is None else [response(found, number)]
    figures += [] if found.dependence is None else [amplitude(found.dependence, words.unit_of(found))]
    return {figure.name: figure for figure in (*figures, bands(found))}


# ------------------------------------------------------------------------------------------------ error over parameters
def error_over_parameters(found: CoupledIdentification) -> Figure:
    """Error on held-out records over the number of parameters, a point for each candidate."""
    sheet, (panel,) = grid(_WIDTH, 4.0)
    tied = [found.candidate(name).error_share for name in found.within_noise]
    panel.add(Span(100 * min(tied), 100 * max(tied), False, GREEN, 0.25, "within noise of the best"))
    for kind, style in _KINDS.items():
        own = sorted((c for c in found.candidates if c.kind == kind), key=lambda c: c.parameters)
        if own:
            panel.add(_candidates(own, label=kind, size=7.0, width=0.7, dash=":", **style))
    panel.add(
        _candidates(
            [found.candidate()], label="chosen", colour=BLACK, dash="", marker="o", size=11.0, face="", edge=BLACK
        )
    )
    if np.isfinite(floor := _share(words.linear_floor(found), found)):
        panel.add(Rule(100 * floor, False, BLACK, "--", 1.0, "left by the best linear model of each amplitude"))
    noise, least = _share(found.noise_rms, found), min(candidate.error_share for candidate in found.candidates)
    if noise > least / _FAR:
        panel.add(Rule(100 * noise, False, BLACK, ":", 1.0, "noise"))
    panel.x = Axis("parameters (1)", log=True)
    panel.y, panel.legend = Axis("error on held-out records (% of rms output)", log=True), Legend("best")
    caption = (
        "Each point is a model, fitted to the other records and run over those that no fit has seen. Of those in the "
        "shaded band, whose differences to the best may be chance, the one with the fewest parameters is chosen."
    )
    if np.isfinite(floor):
        caption += (
            " Dashed: what a linear model of its own for each amplitude would leave at least, the mean over amplitudes;"
            " only a model with hysteresis can be below."
        )
    if noise <= least / _FAR:
        caption += f" Noise, {words.part(noise)}, lies far below."
    return Figure(
        "error-over-parameters", "Error on held-out records over the number of parameters", caption, sheet, {}
    )


def _candidates(own: Sequence[Candidate], **style: Any) -> Line:
    x, y = np.array([c.parameters for c in own], dtype=float), 100 * np.array([c.error_share for c in own])
    return Line(x, y, **style)


def _share(rms: Floats, found: CoupledIdentification) -> float:
    """Rms over outputs and amplitudes over the output, of those amplitudes where it is known; nan for none."""
    shares = words.over_outputs(rms / found.output_rms)
    known = shares[np.isfinite(shares)]
    return float(np.sqrt(np.mean(known**2))) if known.size else float("nan")


# ------------------------------------------------------------------------------------------------------------- response
def response(found: CoupledIdentification, number: int) -> Figure:
    """Magnitude of the response from each drive to each output, measured with its confidence, and modelled.

    Args:
        found: what was identified.
        number: of the amplitude.
    """
    measured, modelled = found.responses[number], found.modelled[number]
    assert measured is not None and modelled is not None
    own, freq = found.candidate().model, measured.freq_hz
    outputs, drives = own.outputs[:MOST], own.actuators[:MOST]
    unit = words.scale(np.median(np.abs(measured.response), axis=0).max(), words.unit_of(found))
    sheet, panels = grid(_WIDTH, 0.9 + 1.9 * len(outputs), len(outputs), len(drives), share_x=True, share_y=True)
    sheet.legend = Legend("above", 4)
    low = np.inf
    for k, panel in enumerate(panels):
        o, i = divmod(k, len(drives))
        size = np.abs(measured.response[:, o, i])
        between_both = banded_rms(freq, np.abs(measured.response[:, o, i] - modelled[:, o, i]) / unit.size)
        kept = thinned_by_logarithm(freq, size, _STRETCHES)
        half = 1.96 / np.sqrt(2.0) * measured.standard_error[kept, o, i]
        x, y = freq[kept], size[kept] / unit.size
        bottom = np.maximum(y - half / unit.size, 0.1 * y)
        panel.add(
            between(x, bottom, y + half / unit.size, SKY, 0.6, "95 % confidence"),
            Line(x, y, BLUE, "", label="measured", marker=".", size=3.0),
            Line(*between_both, ORANGE, width=1.0, label="measured less modelled, rms"),
            Line(x, np.abs(modelled[kept, o, i]) / unit.size, VERMILION, "--", 1.1, label="modelled"),
        )
        low = min(low, float(np.nanmin(between_both[1])))
        panel.x = Axis("frequency (Hz)" if o == len(outputs) - 1 else "", log=True, most=5)
        panel.y = Axis(f"gain ({unit.unit}/V)" if i == 0 else "", log=True)
        panel.title = f"{shortened(drives[i].name, _NAME)} → {shortened(outputs[o].name, _NAME)}"
    for panel in panels:
        panel.y.low = low / 1.5
    at = quantity(float(found.amplitudes_v[number]), "V")
    caption = (
        f"From each drive to each output, at {at} rms drive ({measured.method}). The model is "
        f"{own_name(found)}, run over the same drives and estimated in the same way." + _left_out(found)
    )
    return Figure("response", f"Frequency response at {at} rms drive", caption, sheet, {})


def own_name(found: CoupledIdentification) -> str:
    """The chosen model as it is called in a caption."""
    return f"{found.chosen}, the chosen one"


def _left_out(found: CoupledIdentification) -> str:
    model = found.candidate().model
    if max(len(model.outputs), len(model.actuators)) <= MOST:
        return ""
    both = f"{counted(len(model.outputs), 'output')} and {counted(len(model.actuators), 'drive')}"
    return f" Of {both} the first {MOST} are drawn."


# ------------------------------------------------------------------------------------------------------------ amplitude
def amplitude(dependence: AmplitudeDependence, unit: str) -> Figure:
    """Gain and main resonance over the amplitude of the drive.

    Args:
        dependence: at several amplitudes.
        unit: SI unit of the outputs.
    """
    sheet, (gain, resonance) = grid(_WIDTH, 2.8, 1, 2)
    size, drive = words.scale(dependence.gain, unit), words.scale(dependence.drive_rms, "V")
    x, style = dependence.drive_rms / drive.size, {"colour": BLUE, "marker": "o", "width": 0.8, "dash": ":"}
    gain.add(Line(x, dependence.gain / size.size, **style))  # type: ignore[arg-type]
    error = np.nan_to_num(dependence.resonance_error_hz)
    resonance.add(Line(x, dependence.resonance_hz, y_arms=np.stack([error, error]), **style))  # type: ignore[arg-type]
    gain.y, resonance.y = Axis(f"gain ({size.unit}/V)", most=6), Axis("main resonance (Hz)", most=6)
    gain.x, resonance.x = (Axis(f"drive, rms ({drive.unit})", most=6) for _ in range(2))
    caption = (
        "Of a linear model of each amplitude by itself: the largest gain of any combination of drives, from the lowest "
        "excited frequency to a tenth of the main resonance, and the frequency of the pole with the highest peak with "
        "one standard error. A linear mirror has the same at every amplitude."
    )
    return Figure("amplitude", "Gain and main resonance over the amplitude", caption, sheet, {})


# ---------------------------------------------------------------------------------------------------------------- bands
def bands(found: CoupledIdentification) -> Figure:
    """Error of the chosen model by output and band, at each amplitude of which something is held out."""
    own, edges = found.candidate(), found.bands_hz
    outputs = own.model.outputs[:MOST]
    rows = [k for k in range(found.amplitudes_v.size) if np.isfinite(own.error_rms[k]).all()]
    some = "" if len(rows) <= MOST else f" Of {len(rows)} rms drives the first, the middle and the last are drawn."
    rows = [rows[0], rows[len(rows) // 2], rows[-1]] if some else rows
    unit = words.scale(own.error_rms, words.unit_of(found))
    size = 0.9 + 1.7 * len(rows)
    sheet = Sheet(_WIDTH, size, (1.0,) * len(rows), (1.0,) * len(outputs), share_x=True, share_y=True)
    sheet.legend = Legend("above", 3)
    for row, k in enumerate(rows):
        curves = _levels(found, k)
        for o, output in enumerate(outputs):
            panel = sheet.panel(row, o)
            for values, style in curves:
                panel.add(Line(np.repeat(edges, 2)[1:-1], np.repeat(values[:, o], 2) / unit.size, whole=True, **style))
            panel.x = Axis("frequency (Hz)" if row == len(rows) - 1 else "", log=True, most=5)
            panel.y = Axis(f"rms ({unit.unit})" if o == 0 else "", log=True)
            panel.title = f"{shortened(output.name, _NAME)}, {quantity(float(found.amplitudes_v[k]), 'V')}"
    caption = (
        f"What {own_name(found)}, leaves of each output on the held-out records, as rms in each band, at each rms "
        "drive. Beside it what the measured response of that amplitude leaves, which is what a linear model of its own "
        "would leave at least: distortion and noise. Of that, the noise by itself."
    )
    return Figure("bands", "Error by output and band", caption + _left_out(found) + some, sheet, {})


def _levels(found: CoupledIdentification, number: int) -> list[tuple[Floats, dict[str, Any]]]:
    """Curves of one amplitude: rms in each band, (bands, outputs), with how each is drawn."""
    floor, noise = (levels[number] for levels in words.band_floors(found))
    curves: list[tuple[Floats, dict[str, Any]]] = [
        (
            found.candidate().band_error_rms[number],
            {"colour": VERMILION, "width": 1.6, "label": "measured less modelled"},
        ),
        (floor, {"colour": BLUE, "dash": "--", "width": 1.4, "label": "left by the measured response"}),
        (noise, {"colour": GREEN, "dash": "-.", "width": 1.2, "label": "noise"}),
    ]
    return [(values, style) for values, style in curves if np.isfinite(values).any()]
