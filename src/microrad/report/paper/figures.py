"""The figures of a study, each with the data it shows as a table of columns."""

import math

import numpy as np

from microrad.core.arrays import Floats
from microrad.link.pointing.outage import required_error_rad
from microrad.loop import sine_run as simulate
from microrad.loop.paper_cases import PID, PID_WITH_INVERSE, Run
from microrad.mirror import Variant
from microrad.mission.model import LinkMission, Mission
from microrad.report.plotting.figure import Figure
from microrad.report.plotting.palette import BLACK, BLUE, GREEN, ORANGE, SKY, VERMILION, WHITE
from microrad.report.plotting.sheet import (
    Area,
    Dash,
    Field,
    Legend,
    Line,
    Panel,
    Rule,
    Sheet,
    Words,
    contour,
    grid,
    region,
)
from microrad.study import paper
from microrad.study.study import MarginMap, Study

_LOOKS: tuple[tuple[str, Dash], ...] = ((VERMILION, "--"), (BLUE, "-"))


def paper_figures(study: Study) -> tuple[Figure, ...]:
    """All figures of the study, in the order of the report."""
    drawers = [margin_map, hysteresis_loops, tracking_errors, inverse]
    drawers += [comparison] if any(r.mirror == Variant.COMPARISON for r in study.runs) else []
    figures = [drawer(study) for drawer in drawers]
    return tuple(figures if study.scan is None else [*figures, scan(study.scan)])


def margin_map(study: Study) -> Figure:
    """Fig. 2: link margin over data rate and pointing error."""
    f, m = study.margin_map, study.file.mission
    sheet = study_margin_sheet(study)
    under = "" if m.jitter is None else " (exceeded by the jitter for the outage)"
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
    mesh = np.meshgrid(f.data_rate_bit_s, f.pointing_error_rad, indexing="ij")
    columns = {"data_rate (bit/s)": mesh[0].ravel(), "pointing_error (rad)": mesh[1].ravel()}
    columns["margin (dB)"] = f.margin_db.ravel()
    for (loss, strehl), values in f.by_reading.items():
        columns[f"margin, {loss} pointing loss, Strehl as {strehl} (dB)"] = values.ravel()
    return Figure("fig2-margin-map", "Fig. 2  Link margin", caption, sheet, columns)


def study_margin_sheet(study: Study) -> Sheet:
    """Link margin over data rate and pointing error, with the points that are budgeted and simulated."""
    m = study.file.mission
    left = study.left_rad(study.residual), m.requirement.residual_statistic
    return margin_sheet(study.margin_map, m, left)


def margin_sheet(f: MarginMap, m: LinkMission, left: tuple[float, str] | None = None) -> Sheet:
    """Link margin over data rate and pointing error, with the point that is budgeted.

    Args:
        f: the map.
        m: the mission that it is of.
        left: the simulated residual (rad) with its statistic, which is marked where there is one.
    """
    sheet, (panel,) = grid(6.4, 4.2)
    rate, error = f.data_rate_bit_s * 1e-6, f.pointing_error_rad * 1e6
    required_db = m.requirement.margin_db
    levels = np.arange(-12.0, 19.0, 3.0)
    panel.add(Field(rate, error, f.margin_db.T, levels[0], levels[-1], "link margin (dB)", levels))
    _band(panel, rate, error, np.stack(list(f.by_reading.values())), required_db)
    for part, level in ((2, 0.0), (3, required_db)):  # of five along the contour, so that the words stand apart
        x, y = contour(rate, error, f.margin_db.T, level)
        panel.add(Line(x, y, WHITE, name=f"{level:g} dB"))
        if (at := np.flatnonzero(np.isfinite(x) & (y > 0.02 * error[-1]))).size:
            place = at[part * at.size // 5]
            panel.add(Words(f"{level:g} dB", x[place], y[place], WHITE, anchor="end", shift=(-3.0, -4.0)))
    rate_mbit = m.communication.data_rate_bit_s * 1e-6
    budgeted, allowed = "budget" if m.jitter is None else "static error", m.communication.pointing_error_rad * 1e6
    points = [(allowed, VERMILION, "o", 8.0, f"{budgeted}: {rate_mbit:g} Mbit/s at {allowed:g} µrad")]
    if left is not None:
        left_urad, statistic = left[0] * 1e6, left[1]
        beyond = ", beyond the map" if left_urad > error[-1] else ""
        said = f"simulated residual: {left_urad:.1f} µrad ({statistic}){beyond}"
        points.append((left_urad, SKY, "D", 7.0, said))
    for at_urad, colour, marker, size, label in points:
        place_at = np.array([rate_mbit]), np.array([min(at_urad, error[-1])])
        panel.add(Line(*place_at, colour, "", label=label, marker=marker, size=size, edge=WHITE, clip=False))
    panel.x.title, panel.x.log, panel.x.grid = "data rate (Mbit/s)", True, False
    panel.y.title, panel.y.grid = "pointing error (µrad)", False
    panel.legend = Legend("upper right", colour=WHITE)
    return sheet


def _band(panel: Panel, rate: Floats, error: Floats, maps: Floats, required_db: float) -> None:
    """Hatch where some readings of the conventions have the required margin and others have not."""
    lowest, highest = maps.min(axis=0), maps.max(axis=0)
    between = ((lowest < required_db) & (highest >= required_db)).astype(float).T
    if between.any() and not between.all():
        panel.add(Area(region(rate, error, between, 0.5, 1.5), BLACK, hatched=True))
    label = f"{required_db:g} dB by other readings of the conventions"
    for edge in (lowest, highest):
        panel.add(Line(*contour(rate, error, edge.T, required_db), WHITE, ":", 1.0, label))


def loop_look(place: int) -> tuple[str, Dash]:
    """Colour and dash of a loop, by its place among those drawn together."""
    colours, dashes = (BLACK, BLUE, GREEN, VERMILION, ORANGE, SKY), ("-", "--", "-.", ":")
    return colours[place % 6], dashes[place % 4]


def hysteresis_loops(study: Study) -> Figure:
    """Fig. 5: output and hysteresis over drive, settled, by frequency."""
    sheet, (left, right) = grid(7.4, 3.6, 1, 2)
    columns: dict[str, Floats] = {}
    bias = study.file.mission.mirror.bias_v
    for i, loop in enumerate(study.loops):
        drive, look = loop.drive_v + bias, loop_look(i)
        label = f"{loop.freq_hz:g} Hz: {100 * loop.width:.2f} %"
        left.add(Line(drive, loop.output_rad * 1e3, *look, label=f"{loop.freq_hz:g} Hz"))
        right.add(Line(drive, loop.hysteresis_rad * 1e6, *look, label=label))
        columns[f"drive at {loop.freq_hz:g} Hz (V)"] = drive
        columns[f"output at {loop.freq_hz:g} Hz (rad)"] = loop.output_rad
        columns[f"hysteresis at {loop.freq_hz:g} Hz (rad)"] = loop.hysteresis_rad
    left.x.title = right.x.title = "drive (V)"
    left.y.title, right.y.title = "output about the bias (mrad)", "hysteresis h (µrad)"
    left.legend, right.legend = Legend(title="drive"), Legend("below", 2, "loop width")
    caption = (
        "Settled loops of the hysteresis model alone, without the linear part. Width: peak-to-peak of h over "
        "peak-to-peak of the output. The paper's figure sets its model against measurements that it does not publish."
    )
    return Figure("fig5-hysteresis-loops", "Fig. 5  Rate-dependent hysteresis", caption, sheet, columns)


Curve = tuple[str, str, str]
"""One line of a panel of tracking errors: its label, and the mirror and the controller of the run that it shows."""


def _tracking(
    study: Study, frequencies: tuple[float, ...], curves: tuple[Curve, ...], limit: bool
) -> tuple[Sheet, dict[str, Floats]]:
    """The steady error of two runs, a panel a frequency, with peak and rms in the legend."""
    sheet, panels = grid(3.9 * len(frequencies), 3.5, 1, len(frequencies))
    columns: dict[str, Floats] = {}
    for panel, f in zip(panels, frequencies, strict=True):
        for (label, mirror, controller), look, width in zip(curves, _LOOKS, (1.6, 1.3), strict=True):
            panel.add(_error_line(label, _pick(study, mirror, controller, f), look, width, columns))
        if limit:
            _limit(panel, study.file.mission)
        panel.title = f"{f:g} Hz"
        panel.x.title, panel.y.title = "time, steady state (ms)", "pointing error (µrad)"
        panel.legend = Legend("above", size=7.5)
    return sheet, columns


def _error_line(label: str, run: Run, look: tuple[str, Dash], width: float, columns: dict[str, Floats]) -> Line:
    steady = run.trace.steady
    time = run.trace.time_s[steady] - run.trace.time_s[steady.start]
    error = run.trace.error_rad[steady, 0]
    peak, rms = run.trace.peak_rad * 1e6, run.trace.rms_rad * 1e6
    columns[f"time, {label}, {run.freq_hz:g} Hz (s)"] = time
    columns[f"error, {label}, {run.freq_hz:g} Hz (rad)"] = error
    return Line(time * 1e3, error * 1e6, *look, width, f"{label}: peak {peak:.1f}, rms {rms:.1f} µrad")


def _pick(study: Study, mirror: str, controller: str, freq_hz: float) -> Run:
    return next(r for r in study.runs if (r.mirror, r.controller, r.freq_hz) == (mirror, controller, freq_hz))


def tracking_errors(study: Study) -> Figure:
    """Fig. 6: PID with and without hysteresis."""
    m = study.file.mission
    curves = ("with hysteresis", Variant.GIVEN, PID), ("without", Variant.STRAIGHT, PID)
    sheet, columns = _tracking(study, m.scenario.pid_frequencies_hz, curves, limit=False)
    caption = (
        f"Tracking error of a {_amplitude(m)} sine under PID, on the mirror and on one of the same gain without "
        "hysteresis."
    )
    return Figure("fig6-pid", "Fig. 6  PID with and without hysteresis", caption, sheet, columns)


def inverse(study: Study) -> Figure:
    """Fig. 8: PID against PID with inverse feedforward."""
    m = study.file.mission
    curves = (PID, Variant.GIVEN, PID), (PID_WITH_INVERSE, Variant.GIVEN, PID_WITH_INVERSE)
    sheet, columns = _tracking(study, m.scenario.inverse_frequencies_hz, curves, limit=True)
    counts = "; ".join(_counts(r) for r in study.runs if (r.mirror, r.controller) == (Variant.GIVEN, PID_WITH_INVERSE))
    caption = (
        f"Tracking error of a {_amplitude(m)} sine. The feedforward inverts the hysteresis model, driven by the "
        f"reference and its rate. Dotted: the required {m.requirement.pointing_error_rad * 1e6:g} µrad. "
        f"Counts of PID + inverse: {counts}."
    )
    return Figure("fig8-inverse", "Fig. 8  PID against PID + inverse", caption, sheet, columns)


def comparison(study: Study) -> Figure:
    """PID + inverse on the mission's hysteresis model and on its comparison model."""
    both = ("mirror's model", Variant.GIVEN), ("comparison model", Variant.COMPARISON)
    curves = tuple((*each, PID_WITH_INVERSE) for each in both)
    sheet, columns = _tracking(study, study.file.mission.scenario.inverse_frequencies_hz, curves, limit=True)
    caption = "PID + inverse on the mirror as given and on the mission's comparison model, each with its own inverse."
    return Figure("comparison", "Hysteresis models compared", caption, sheet, columns)


def _amplitude(m: Mission) -> str:
    return f"{m.scenario.amplitude_rad * 1e6:g} µrad"


def _limit(panel: Panel, m: Mission) -> None:
    axes_in_error = math.sqrt(2.0) if m.conventions.residual == "radial" else 1.0
    allowed = m.requirement.pointing_error_rad / axes_in_error
    panel.add(*(Rule(sign * allowed * 1e6, False, BLACK, ":", 0.9) for sign in (-1.0, 1.0)))


def _counts(run: Run) -> str:
    c: simulate.Counts = run.trace.counts
    return (
        f"{run.freq_hz:g} Hz {c.clamped + c.inverse_clamped} rate-clamped, {c.saturated} saturated, "
        f"{c.slew_limited} slew-limited, {c.alternating} alternating"
    )


def scan(found: paper.Scan) -> Figure:
    """Which of the paper's closed-loop claims hold over gains and compositions."""
    sheet, panels = grid(7.6, 3.3, 1, len(paper.COMPOSITIONS), share_y=True)
    most = len(paper.CLAIMS)
    for panel, composition in zip(panels, paper.COMPOSITIONS, strict=True):
        here = [p for p in found.points if p.composition == composition]
        ki = sorted({p.integral_v_rad_s * 1e-6 for p in here})
        kp = sorted({p.proportional_v_rad * 1e-3 for p in here})
        held = np.zeros((len(kp), len(ki)))
        for p in here:
            held[kp.index(p.proportional_v_rad * 1e-3), ki.index(p.integral_v_rad_s * 1e-6)] = sum(p.holds().values())
        said = f"claims that hold (of {most})"
        bar = said if composition == paper.COMPOSITIONS[-1] else ""
        places = np.arange(1.0 * len(ki)), np.arange(1.0 * len(kp))
        panel.add(Field(*places, held, 0.0, most, bar, ticks=range(most + 1), spoken=said))
        for (row, column), value in np.ndenumerate(held):
            panel.add(Words(f"{value:.0f}", column, row, WHITE if value < most / 2 else BLACK, anchor="middle"))
        panel.x.ticks = {k: f"{v:g}" for k, v in enumerate(ki)}
        panel.y.ticks = {k: f"{v:g}" for k, v in enumerate(kp)}
        panel.title, panel.x.title = composition, "integral gain (1000 V/(mrad s))"
        panel.x.grid = panel.y.grid = False
    panels[0].y.title = "proportional gain (V/mrad)"
    points = found.points
    columns = {
        "additive (1) or cascade (0)": np.array([float(p.composition == "additive") for p in points]),
        "proportional (V/rad)": np.array([p.proportional_v_rad for p in points]),
        "integral (V/(rad s))": np.array([p.integral_v_rad_s for p in points]),
    }
    for name in paper.CLAIMS:
        columns[name] = np.array([float(p.holds()[name]) for p in points])
    caption = "How many of these hold at each pair of gains: " + "; ".join(paper.CLAIMS) + "."
    return Figure("claims-scan", "Where the paper's closed-loop claims hold", caption, sheet, columns)
