"""The figures of a study: each an SVG, with the data it shows as a table of columns."""

import contextlib
import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure as Canvas

from microrad.core.arrays import Floats
from microrad.core.kept import NOTHING, Kept
from microrad.link.under_jitter import required_error_rad
from microrad.loop import sine_run as simulate
from microrad.loop.paper_cases import Run
from microrad.mission.model import Mission
from microrad.report import interactive
from microrad.report.inlined import inlined
from microrad.report.svg_text import svg_text
from microrad.report.tables import Column, rows_of
from microrad.study import paper
from microrad.study.story import Study

# Okabe and Ito's palette: told apart by colour-blind readers. Line styles differ too, for print in grey.
BLACK, ORANGE, SKY, GREEN, BLUE, VERMILION = "#000000", "#E69F00", "#56B4E9", "#009E73", "#0072B2", "#D55E00"
STYLE: dict[Any, Any] = {
    "svg.fonttype": "none",
    "svg.hashsalt": "microrad",
    "font.family": "sans-serif",
    "font.size": 9.0,
    "axes.grid": True,
    "grid.color": "#dddddd",
    "grid.linewidth": 0.6,
    "axes.axisbelow": True,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "legend.frameon": False,
    "lines.linewidth": 1.3,
}
MOST_POINTS = 1200  # of a drawn line; peaks are kept


class Picture(str):
    """The text of an <svg> element; ``plot`` is the same picture for the page's script, "" where it is static only."""

    plot: str = ""


@dataclass(frozen=True, slots=True)
class Figure:
    """One figure: file name without ending, title, caption, SVG text, and columns of data by heading with unit."""

    name: str
    title: str
    caption: str
    svg: str
    columns: Mapping[str, Column]

    @property
    def plot(self) -> str:
        """The JSON that the page draws the interactive figure from; "" where the SVG stands alone."""
        return self.svg.plot if isinstance(self.svg, Picture) else ""

    @property
    def labelled(self) -> str:
        """The SVG with its text alternative and ids of its own, for the page."""
        return inlined(self.svg, self.name, self.title)

    @property
    def static(self) -> "Figure":
        """The figure without its interactive form."""
        return replace(self, svg=str(self.svg))

    def rows(self, digits: int) -> list[tuple[str, ...]]:
        """The data as rows of text, numbers to so many digits."""
        return rows_of(self.columns, digits)


def draw(study: Study, parts: Kept = NOTHING) -> tuple[Figure, ...]:
    """All figures of the study, in the order of the report."""
    drawers = [margin_map, hysteresis_loops, tracking_errors, inverse]
    drawers += [comparison] if any(r.mirror == "comparison" for r in study.runs) else []
    with rc_context(STYLE):
        figures = [parts.part(drawer, study) for drawer in drawers]
        if study.scan is not None:
            figures.append(parts.part(scan, study.scan))
    return tuple(figures)


def svg_of(canvas: Canvas) -> Picture:
    """The canvas as the text of an <svg> element, its coordinates to a hundredth of a point, with its plot."""
    picture = Picture(svg_text(canvas))
    with contextlib.suppress(interactive.StaticOnlyError):
        picture.plot = interactive.text_of(interactive.plot_of(canvas))
    return picture


def thin(x: Floats, y: Floats, most: int = MOST_POINTS) -> tuple[Floats, Floats]:
    """Fewer points for drawing: the lowest and highest of each stretch, so that no peak is lost."""
    stretch = 2 * y.size // most
    if stretch < 4:
        return x, y
    whole = y.size // stretch * stretch
    blocks = y[:whole].reshape(-1, stretch)
    first = np.arange(blocks.shape[0]) * stretch
    picks = np.sort(np.stack([first + blocks.argmin(axis=1), first + blocks.argmax(axis=1)], axis=1), axis=1).ravel()
    return x[picks], y[picks]


def margin_map(study: Study) -> Figure:
    """Fig. 2: link margin over data rate and pointing error."""
    f, m = study.margin_map, study.file.mission
    canvas = Canvas(figsize=(6.4, 4.2), layout="constrained")
    axes = canvas.subplots()
    rate, error = f.data_rate_bit_s * 1e-6, f.pointing_error_rad * 1e6
    levels = np.arange(-12.0, 19.0, 3.0)
    filled = axes.contourf(rate, error, f.margin_db.T, levels=levels, cmap="cividis", extend="both")
    interactive.keep_values(filled, rate, error, f.margin_db.T)
    _band(axes, rate, error, np.stack(list(f.by_reading.values())), m.requirement.margin_db)
    lines = axes.contour(rate, error, f.margin_db.T, levels=[0.0, m.requirement.margin_db], colors="white")
    axes.clabel(lines, fmt=lambda level: f"{level:g} dB", fontsize=8)
    rate_mbit = m.communication.data_rate_bit_s * 1e-6
    budgeted = "budget" if m.jitter is None else "static error"
    under = "" if m.jitter is None else " (exceeded by the jitter for the outage)"
    axes.plot(
        [rate_mbit],
        [m.communication.pointing_error_rad * 1e6],
        "o",
        color=VERMILION,
        markeredgecolor="white",
        markersize=8,
        label=f"{budgeted}: {rate_mbit:g} Mbit/s at {m.communication.pointing_error_rad * 1e6:g} µrad",
    )
    left = residual_urad(study)
    axes.plot(
        [rate_mbit],
        [min(left, error[-1])],
        "D",
        color=SKY,
        markeredgecolor="white",
        markersize=7,
        label=f"simulated residual: {left:.1f} µrad ({m.requirement.residual_statistic})"
        + (", beyond the map" if left > error[-1] else ""),
    )
    axes.set(xscale="log", xlabel="data rate (Mbit/s)", ylabel="pointing error (µrad)")
    axes.grid(visible=False)
    axes.legend(loc="upper right", labelcolor="white", fontsize=8)
    canvas.colorbar(filled, ax=axes, label="link margin (dB)")
    counts = [r.photons_per_bit for r in f.readings]
    convention = f"{m.conventions.pointing_loss} pointing loss, Strehl as {m.conventions.strehl}"
    largest = f"at most {f.largest_error_rad * 1e6:.2f} µrad" if f.largest_error_rad > 0 else "not even on axis"
    required = required_error_rad(study.links.data)
    caption = (
        f"Margin of the communication link ({convention}). For {m.requirement.margin_db:g} dB: at most "
        f"{f.largest_rate_bit_s * 1e-6:.1f} Mbit/s at {required * 1e6:.4g} µrad{under}, or {largest} "
        f"at {m.communication.data_rate_bit_s * 1e-6:g} Mbit/s (both solved). "
        f"Hatched between dotted lines: the band in which the {m.requirement.margin_db:g} dB contour lies over the "
        f"{len(counts)} readings of pointing loss and Strehl, the receiver unchanged. The same point implies a "
        f"receiver of {min(counts):.0f} to {max(counts):.0f} photons per bit over them, "
        f"{10 * np.log10(max(counts) / min(counts)):.1f} dB apart."
    )
    grid = np.meshgrid(f.data_rate_bit_s, f.pointing_error_rad, indexing="ij")
    columns = {"data_rate (bit/s)": grid[0].ravel(), "pointing_error (rad)": grid[1].ravel()}
    columns["margin (dB)"] = f.margin_db.ravel()
    for (loss, strehl), values in f.by_reading.items():
        columns[f"margin, {loss} pointing loss, Strehl as {strehl} (dB)"] = values.ravel()
    return Figure("fig2-margin-map", "Fig. 2  Link margin", caption, svg_of(canvas), columns)


def _band(axes: Axes, rate: Floats, error: Floats, maps: Floats, required_db: float) -> None:
    """Hatch where some readings of the conventions have the required margin and others have not."""
    lowest, highest = maps.min(axis=0), maps.max(axis=0)
    between = ((lowest < required_db) & (highest >= required_db)).astype(float).T
    if between.any() and not between.all():
        axes.contourf(rate, error, between, levels=[0.5, 1.5], colors="none", hatches=["////"], zorder=1.5)
    for edge in (lowest, highest):
        axes.contour(rate, error, edge.T, levels=[required_db], colors="white", linestyles=":", linewidths=1.0)
    axes.plot([], [], ":", color="white", label=f"{required_db:g} dB by other readings of the conventions")


def residual_urad(study: Study) -> float:
    """The residual in the mission's statistic, in µrad."""
    return study.left_rad(study.residual) * 1e6


def hysteresis_loops(study: Study) -> Figure:
    """Fig. 5: output and hysteresis over drive, settled, by frequency."""
    canvas = Canvas(figsize=(7.4, 3.6), layout="constrained")
    left, right = canvas.subplots(1, 2)
    styles = ["-", "--", "-.", ":"]
    colours = [BLACK, BLUE, GREEN, VERMILION, ORANGE, SKY]
    columns: dict[str, Floats] = {}
    bias = study.file.mission.mirror.bias_v
    for i, loop in enumerate(study.loops):
        style: dict[str, Any] = {"color": colours[i % 6], "linestyle": styles[i % 4]}
        label = f"{loop.freq_hz:g} Hz: {100 * loop.width:.2f} %"
        x, y = thin(loop.drive_v + bias, loop.output_rad)
        left.plot(x, y * 1e3, label=f"{loop.freq_hz:g} Hz", **style)
        x, y = thin(loop.drive_v + bias, loop.hysteresis_rad)
        right.plot(x, y * 1e6, label=label, **style)
        columns[f"drive at {loop.freq_hz:g} Hz (V)"] = loop.drive_v + bias
        columns[f"output at {loop.freq_hz:g} Hz (rad)"] = loop.output_rad
        columns[f"hysteresis at {loop.freq_hz:g} Hz (rad)"] = loop.hysteresis_rad
    left.set(xlabel="drive (V)", ylabel="output about the bias (mrad)")
    right.set(xlabel="drive (V)", ylabel="hysteresis h (µrad)")
    left.legend(title="drive", fontsize=8)
    right.legend(title="loop width", fontsize=8, loc="upper left", bbox_to_anchor=(0.0, -0.18), ncols=2)
    caption = (
        "Settled loops of the hysteresis model alone, without the linear part. Width: peak-to-peak of h over "
        "peak-to-peak of the output. The paper's figure sets its model against measurements that it does not publish."
    )
    return Figure("fig5-hysteresis-loops", "Fig. 5  Rate-dependent hysteresis", caption, svg_of(canvas), columns)


@dataclass(frozen=True, slots=True)
class Curve:
    """One line of a panel of tracking errors: its label, and which run it shows."""

    label: str
    mirror: str
    controller: str


def _tracking(
    study: Study, frequencies: tuple[float, ...], curves: tuple[Curve, Curve], limit: bool
) -> tuple[str, dict[str, Floats]]:
    """SVG and data of the steady error of two runs, a panel a frequency, with peak and rms in the legend."""
    canvas = Canvas(figsize=(3.9 * len(frequencies), 3.5), layout="constrained")
    columns: dict[str, Floats] = {}
    styles: tuple[dict[str, Any], ...] = (
        {"color": VERMILION, "linestyle": "--", "linewidth": 1.6},
        {"color": BLUE, "linestyle": "-"},
    )
    for axes, f in zip(canvas.subplots(1, len(frequencies), squeeze=False)[0], frequencies, strict=True):
        for curve, style in zip(curves, styles, strict=True):
            _error_line(axes, curve.label, _pick(study, curve.mirror, curve.controller, f), style, columns)
        if limit:
            _limit(axes, study.file.mission)
        axes.set_title(f"{f:g} Hz", fontsize=9, loc="left")
        axes.set(xlabel="time, steady state (ms)", ylabel="pointing error (µrad)")
        axes.legend(fontsize=7.5, loc="lower center", bbox_to_anchor=(0.5, 1.08))
    return svg_of(canvas), columns


def _error_line(axes: Axes, label: str, run: Run, style: dict[str, Any], columns: dict[str, Floats]) -> None:
    steady = run.trace.steady
    time = run.trace.time_s[steady] - run.trace.time_s[steady.start]
    error = run.trace.error_rad[steady, 0]
    peak, rms = run.trace.peak_rad * 1e6, run.trace.rms_rad * 1e6
    axes.plot(*thin(time * 1e3, error * 1e6), label=f"{label}: peak {peak:.1f}, rms {rms:.1f} µrad", **style)
    columns[f"time, {label}, {run.freq_hz:g} Hz (s)"] = time
    columns[f"error, {label}, {run.freq_hz:g} Hz (rad)"] = error


def _pick(study: Study, mirror: str, controller: str, freq_hz: float) -> Run:
    return next(r for r in study.runs if (r.mirror, r.controller, r.freq_hz) == (mirror, controller, freq_hz))


def tracking_errors(study: Study) -> Figure:
    """Fig. 6: PID with and without hysteresis."""
    m = study.file.mission
    curves = (Curve("with hysteresis", "given", "PID"), Curve("without", "no hysteresis", "PID"))
    svg, columns = _tracking(study, m.scenario.pid_frequencies_hz, curves, limit=False)
    caption = (
        f"Tracking error of a {_amplitude(m)} sine under PID, on the mirror and on one of the same gain without "
        "hysteresis."
    )
    return Figure("fig6-pid", "Fig. 6  PID with and without hysteresis", caption, svg, columns)


def inverse(study: Study) -> Figure:
    """Fig. 8: PID against PID with inverse feedforward."""
    m = study.file.mission
    curves = (Curve("PID", "given", "PID"), Curve("PID + inverse", "given", "PID + inverse"))
    svg, columns = _tracking(study, m.scenario.inverse_frequencies_hz, curves, limit=True)
    counts = "; ".join(_counts(r) for r in study.runs if (r.mirror, r.controller) == ("given", "PID + inverse"))
    caption = (
        f"Tracking error of a {_amplitude(m)} sine. The feedforward inverts the hysteresis model, driven by the "
        f"reference and its rate. Dotted: the required {m.requirement.pointing_error_rad * 1e6:g} µrad. "
        f"Counts of PID + inverse: {counts}."
    )
    return Figure("fig8-inverse", "Fig. 8  PID against PID + inverse", caption, svg, columns)


def comparison(study: Study) -> Figure:
    """PID + inverse on the mission's hysteresis model and on its comparison model."""
    curves = (
        Curve("mirror's model", "given", "PID + inverse"),
        Curve("comparison model", "comparison", "PID + inverse"),
    )
    svg, columns = _tracking(study, study.file.mission.scenario.inverse_frequencies_hz, curves, limit=True)
    caption = "PID + inverse on the mirror as given and on the mission's comparison model, each with its own inverse."
    return Figure("comparison", "Hysteresis models compared", caption, svg, columns)


def _amplitude(m: Mission) -> str:
    return f"{m.scenario.amplitude_rad * 1e6:g} µrad"


def _limit(axes: Axes, m: Mission) -> None:
    axes_in_error = math.sqrt(2.0) if m.conventions.residual == "radial" else 1.0
    allowed = m.requirement.pointing_error_rad / axes_in_error
    for sign in (-1.0, 1.0):
        axes.axhline(sign * allowed * 1e6, color=BLACK, linestyle=":", linewidth=0.9)


def _counts(run: Run) -> str:
    c: simulate.Counts = run.trace.counts
    return (
        f"{run.freq_hz:g} Hz {c.clamped + c.inverse_clamped} rate-clamped, {c.saturated} saturated, "
        f"{c.slew_limited} slew-limited, {c.alternating} alternating"
    )


def scan(found: paper.Scan) -> Figure:
    """Which of the paper's closed-loop claims hold over gains and compositions."""
    canvas = Canvas(figsize=(7.6, 3.3), layout="constrained")
    panels = canvas.subplots(1, len(paper.COMPOSITIONS), sharey=True)
    most = len(paper.CLAIMS)
    for axes, composition in zip(panels, paper.COMPOSITIONS, strict=True):
        here = [p for p in found.points if p.composition == composition]
        ki = sorted({p.integral_v_rad_s * 1e-6 for p in here})
        kp = sorted({p.proportional_v_rad * 1e-3 for p in here})
        held = np.zeros((len(kp), len(ki)))
        for p in here:
            held[kp.index(p.proportional_v_rad * 1e-3), ki.index(p.integral_v_rad_s * 1e-6)] = sum(p.holds().values())
        image = axes.imshow(held, cmap="cividis", vmin=0, vmax=most, aspect="auto", origin="lower")
        for (row, column), value in np.ndenumerate(held):
            colour = "white" if value < most / 2 else "black"
            axes.text(column, row, f"{value:.0f}", ha="center", va="center", color=colour, fontsize=8)
        axes.set_xticks(range(len(ki)), [f"{v:g}" for v in ki])
        axes.set_yticks(range(len(kp)), [f"{v:g}" for v in kp])
        axes.set_title(composition, fontsize=9, loc="left")
        axes.set_xlabel("integral gain (1000 V/(mrad s))")
        axes.grid(visible=False)
    panels[0].set_ylabel("proportional gain (V/mrad)")
    canvas.colorbar(image, ax=panels, label=f"claims that hold (of {most})", ticks=range(most + 1))
    points = found.points
    columns = {
        "additive (1) or cascade (0)": np.array([float(p.composition == "additive") for p in points]),
        "proportional (V/rad)": np.array([p.proportional_v_rad for p in points]),
        "integral (V/(rad s))": np.array([p.integral_v_rad_s for p in points]),
    }
    for name in paper.CLAIMS:
        columns[name] = np.array([float(p.holds()[name]) for p in points])
    caption = "How many of these hold at each pair of gains: " + "; ".join(paper.CLAIMS) + "."
    return Figure("claims-scan", "Where the paper's closed-loop claims hold", caption, svg_of(canvas), columns)
