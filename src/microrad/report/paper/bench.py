"""Fig. 4 and 5 of the paper as the virtual bench measures them: chirp and sines, recorded, fitted and predicted.

The bench plays Eq. 2 and Eq. 3 as printed (the plan "paper-experiment"), whatever the mission's mirror: the paper's own
records are not published. The poles of the linear fit and the parameters of Eq. 3 are found anew from the records.
"""

from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from microrad.core.arrays import Floats
from microrad.core.kept import NOTHING, Kept
from microrad.lab import bench, identify
from microrad.lab.recording import Recording
from microrad.report.plotting.figure import Figure
from microrad.report.plotting.palette import BLACK, BLUE, GREEN, VERMILION
from microrad.report.plotting.sheet import Legend, Line, grid
from microrad.study.study import Study

PLAN = "paper-experiment"
SEED = 1
ORDER = 5  # of Eq. 1
CLAIMED_FIT_PERCENT = 97.0  # section 3.3
_COLOURS = (BLUE, GREEN, VERMILION)


@dataclass(frozen=True, slots=True)
class Chirp:
    """Fig. 4: the recorded chirp and the linear model fitted to it.

    ``drive_v``, ``measured_rad`` and ``modelled_rad`` over ``time_s``, about their means; ``fit_percent`` is
    100 (1 - |y - yhat| / |y - mean y|). The measured response has one value a frequency, with its ``model``.
    """

    time_s: Floats
    drive_v: Floats
    measured_rad: Floats
    modelled_rad: Floats
    fit_percent: float
    freq_hz: Floats
    response: NDArray[np.complex128]
    model: NDArray[np.complex128]


@dataclass(frozen=True, slots=True)
class Loop:
    """Fig. 5: a period of a recorded sine, and Eq. 3 as fitted at ``fitted_hz``; ``error_percent`` of peak to peak."""

    freq_hz: float
    fitted_hz: float
    drive_v: Floats
    measured_rad: Floats
    modelled_rad: Floats
    error_percent: float


@cache
def chirp() -> Chirp:
    """Play the paper's chirp and fit the five poles of Eq. 1 to it; the same every time."""
    (record,) = bench.play(bench.select_records(bench.load_plan(PLAN), ["chirp"]), SEED)
    found = identify.response_from_records([record])
    weight = 1.0 / found.standard_error
    fit = identify.vector_fit(
        found.freq_hz,
        found.response,
        ORDER,
        weight=weight,
        hold=found.hold,
        rate_hz=record.rate_hz,
        strictly_proper=True,
    )
    error = identify.output_error(fit.modes(), record)[:, 0]
    drive, output = (each[:, 0] - each.mean() for each in (record.drive, record.output))
    percent = 100.0 * (1.0 - float(np.linalg.norm(error) / np.linalg.norm(output)))
    return Chirp(
        np.arange(output.size) / record.rate_hz,
        drive,
        1e-3 * output,
        1e-3 * (output - error),
        percent,
        found.freq_hz,
        1e-3 * found.response[:, 0, 0],
        1e-3 * fit.response(found.freq_hz)[:, 0, 0],
    )


@cache
def loops() -> tuple[Loop, ...]:
    """Play the paper's sines, fit Eq. 3 to the fastest alone as the paper does, predict all; the same every time."""
    plan = bench.load_plan(PLAN)
    names = [r.excitation.name for r in plan.records if r.kind == "sines"]
    records = {_freq_hz(r): r for r in bench.play(bench.select_records(plan, names), SEED)}
    fitted = max(records)
    fit = identify.fit_bouc_wen([records[fitted]], starts=4)
    return tuple(_loop(fit, record, freq, fitted) for freq, record in sorted(records.items()))


def _freq_hz(record: Recording) -> float:
    return float(record.path.removesuffix("hz").rpartition("-")[2])


def _loop(fit: identify.BoucWenFit, record: Recording, freq_hz: float, fitted_hz: float) -> Loop:
    """The last whole period, settled."""
    found = identify.predict(fit, record)
    period = round(record.rate_hz / freq_hz)
    last = slice(-period - 1, None)
    error = found.residual_rad[found.start :]
    percent = 100.0 * float(np.sqrt(np.mean(error**2)) / np.ptp(found.measured_rad))
    return Loop(freq_hz, fitted_hz, record.drive[last, 0], found.measured_rad[last], found.model_rad[last], percent)


def bench_figures(study: Study, parts: Kept = NOTHING) -> tuple[Figure, ...]:
    """Both figures for a mission with a mirror of the paper's kind; none for others.

    Args:
        study: a run of a whole mission.
        parts: those of earlier runs that are kept: none by default.
    """
    if study.scan is None:
        return ()
    return chirp_figure(parts.part(chirp)), loops_figure(parts.part(loops))


def chirp_figure(found: Chirp) -> Figure:
    """Fig. 4: measured and modelled output over time, and the response that the model was fitted to."""
    sheet, (whole, close, size, phase) = grid(7.6, 5.4, 2, 2)
    sheet.legend = Legend("above", 2)
    far, zoom = found.freq_hz[-1], close_up(found)
    looks = ((VERMILION, "-", "measured (virtual bench)"), (BLUE, "--", "model"))
    for panel, part in ((whole, slice(None)), (close, zoom)):
        for y, (colour, dash, label) in zip((found.measured_rad, found.modelled_rad), looks, strict=True):
            panel.add(Line(found.time_s[part], y[part] * 1e6, colour, dash, 1.1, label))
        panel.x.title, panel.y.title = "time (s)", "output about its mean (µrad)"
    for values, colour, dash, marker in ((found.response, VERMILION, "", "."), (found.model, BLUE, "--", "")):
        turn = np.degrees(np.unwrap(np.angle(values)))
        for panel, y in ((size, np.abs(values) * 1e6), (phase, turn)):
            panel.add(Line(found.freq_hz, y, colour, dash, marker=marker, size=3.0))
    for panel in (size, phase):
        panel.x.title, panel.x.log, panel.x.high = "frequency (Hz)", True, far
    size.y.title, phase.y.title, size.y.low = "gain (µrad/V)", "phase (°)", 0.0
    caption = (
        f"Virtual bench, no laboratory: a chirp of {found.freq_hz[0]:.3g} Hz to {far:.4g} Hz played into Eq. 2 as "
        f"printed, with sensor noise of 3 % and 16-bit converters; a model with {ORDER} poles fitted to the record "
        f"explains {found.fit_percent:.1f} % of it (the paper: about {CLAIMED_FIT_PERCENT:g} %); the rest is the noise "
        "that was put in. Top: output over time, whole and close up; bottom: the frequency response that was fitted."
    )
    columns = {
        "time, close up (s)": found.time_s[zoom],
        "drive about its mean (V)": found.drive_v[zoom],
        "measured about its mean (rad)": found.measured_rad[zoom],
        "modelled about its mean (rad)": found.modelled_rad[zoom],
        "frequency (Hz)": found.freq_hz,
        "gain, measured (rad/V)": np.abs(found.response),
        "phase, measured (rad)": np.unwrap(np.angle(found.response)),
        "gain, model (rad/V)": np.abs(found.model),
        "phase, model (rad)": np.unwrap(np.angle(found.model)),
    }
    title = "Fig. 4  Identified linear dynamics (virtual bench)"
    return Figure("fig4-chirp", title, caption, sheet, columns)


def close_up(found: Chirp) -> slice:
    """The samples of the close-up: some periods at about 200 Hz."""
    first = int(0.62 * found.time_s.size)
    return slice(first, first + 1500)


def loops_figure(found: tuple[Loop, ...]) -> Figure:
    """Fig. 5: measured loops with the model that was fitted to the fastest alone."""
    sheet, panels = grid(7.6, 3.2, 1, len(found), share_y=True)
    columns: dict[str, Floats] = {}
    for panel, loop, colour in zip(panels, found, _COLOURS, strict=False):
        x, y = _points(loop.drive_v, loop.measured_rad)
        panel.add(Line(x, y, colour, "", label="measured (virtual bench)", marker="o", size=4.5, face=""))
        panel.add(Line(loop.drive_v, loop.modelled_rad * 1e3, BLACK, width=0.9, label="model"))
        role = "fitted" if loop.freq_hz == loop.fitted_hz else "predicted"
        panel.title = f"{loop.freq_hz:g} Hz, {role}: {loop.error_percent:.2f} % rms"
        panel.title_size, panel.x.title, panel.x.most = 8.5, "drive (V)", 4
        columns[f"drive at {loop.freq_hz:g} Hz (V)"] = loop.drive_v
        columns[f"measured at {loop.freq_hz:g} Hz (rad)"] = loop.measured_rad
        columns[f"model at {loop.freq_hz:g} Hz (rad)"] = loop.modelled_rad
    panels[0].y.title, panels[0].legend = "output (mrad)", Legend("upper left")
    fitted = found[0].fitted_hz
    caption = (
        "Virtual bench, no laboratory: the paper's sines played into Eq. 3 as printed, with 1 µrad of sensor noise. "
        f"As in the paper Eq. 3 is fitted to the {fitted:g} Hz record alone and predicts the others; errors are rms in "
        "% of the peak-to-peak output, most of it sensor noise."
    )
    title = "Fig. 5  Hysteresis measured and modelled (virtual bench)"
    return Figure("fig5-bench-loops", title, caption, sheet, columns)


def _points(drive_v: Floats, output_rad: Floats, most: int = 60) -> tuple[Floats, Floats]:
    """Some of the samples, so that each point can be seen; output in mrad."""
    step = max(1, drive_v.size // most)
    return drive_v[::step], output_rad[::step] * 1e3
