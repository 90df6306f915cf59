"""Figures of the links: what moves the margin most, and the wide beacon against the scan."""

import math
from collections.abc import Sequence

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure as Canvas
from matplotlib.patches import Patch

from microrad.core.kept import NOTHING, Kept
from microrad.core.units import format_quantity
from microrad.link import Swing, Tornado
from microrad.link.acquisition import Trade
from microrad.link.partner_search import Finding
from microrad.link.requirement import outage_words
from microrad.link.study import LinkStudy
from microrad.report.day_assumptions import swing_bars
from microrad.report.figures import BLUE, ORANGE, STYLE, VERMILION, Figure, svg_of
from microrad.report.tables import Column

MOST_BARS = 14
_TITLES = {
    "Communication": ("tornado", "What moves the margin"),
    "Beacon": ("tornado-beacon", "What moves the margin of the beacon"),
    "Answer": ("tornado-answer", "What moves the margin of the answer"),
}


def draw(study: LinkStudy, parts: Kept = NOTHING) -> tuple[Figure, ...]:
    """The figures of the links, in the order of the page."""
    with rc_context(STYLE):
        figures = [parts.part(tornado, study, t) for t in study.tornados if t.swings]
        if study.finding is not None and study.finding.trade is not None:
            figures.append(parts.part(trade, study, study.finding, study.finding.trade))
    return tuple(figures)


def tornado(study: LinkStudy, of: Tornado) -> Figure:
    """One margin over each of its inputs, one at a time."""
    shown, margin = of.swings[:MOST_BARS], of.margin_db
    canvas = Canvas(figsize=(6.4, 0.9 + 0.27 * len(shown)), layout="constrained")
    axes = canvas.subplots()
    lost_db = _lost(shown, margin)
    ends = [(max(swing.margin_low_db, lost_db), max(swing.margin_high_db, lost_db)) for swing in shown]
    swing_bars(axes, [_label(swing) for swing in shown], ends, margin)
    for row, swing in enumerate(shown):
        if not math.isfinite(swing.swing_db):
            ink = "white" if math.isinf(swing.margin_high_db) else "black"
            _say(axes, (lost_db, row), "< no margin: receiver too slow", ink, "center")
    m, data = study.file.mission, of.of == study.communication.name
    required = m.requirement.margin_db
    low, high = axes.get_xlim()
    if data and low < required < high:
        axes.axvline(required, color=VERMILION, linestyle="--", linewidth=1.0)
        _say(axes, (required, -0.55), "required", VERMILION, "bottom")
    judged = f", all but {outage_words(m.requirement)}" if data and m.jitter is not None else ""
    axes.set(xlabel=f"margin of the {'communication link' if data else of.of.lower()}{judged} (dB)")
    keys = [Patch(color=ORANGE, label="input lower"), Patch(color=BLUE, label="input higher")]
    axes.legend(handles=keys, loc="lower right", fontsize=8)
    assumed = [s.key for s in shown if s.kind == "assumption"]
    caption = (
        "Margin with one input at a time 10 % lower and higher (0.5 dB for those in decibels, a factor of ten for a "
        "bit error ratio and an outage), never beyond its bounds; all others as they are."
    )
    if assumed:
        caption += f" Assumptions among them: {', '.join(assumed)}."
    columns: dict[str, Column] = {
        "input": tuple(s.key for s in of.swings),
        "SI unit": tuple(s.unit for s in of.swings),
        "margin lower (dB)": np.array([s.margin_low_db for s in of.swings]),
        "margin higher (dB)": np.array([s.margin_high_db for s in of.swings]),
        "value (SI)": np.array([s.value for s in of.swings]),
        "lower (SI)": np.array([s.low for s in of.swings]),
        "higher (SI)": np.array([s.high for s in of.swings]),
    }
    name, title = _TITLES[of.of]
    return Figure(name, title, caption, svg_of(canvas), columns)


def _say(axes: Axes, place: tuple[float, float], words: str, color: str, va: str) -> None:
    """Words just right of a place."""
    axes.annotate(words, place, (3, 0), textcoords="offset points", color=color, fontsize=8, va=va)


def _lost(shown: Sequence[Swing], margin_db: float) -> float:
    """Where the bar of an input ends that leaves no link: beyond all others."""
    ends = [end for s in shown for end in (s.margin_low_db, s.margin_high_db) if math.isfinite(end)]
    reach = max((abs(end - margin_db) for end in ends), default=0.0)
    return margin_db - max(1.5 * reach, 1.0)


def _label(swing: Swing) -> str:
    key = swing.key.removeprefix("communication.")
    return f"{key} = {format_quantity(swing.value, swing.unit, 3)}".rstrip()


def trade(study: LinkStudy, found: Finding, t: Trade) -> Figure:
    """Section 2.1 of the paper as a picture: a wide beacon, or a scan with a narrow beam."""
    canvas = Canvas(figsize=(6.4, 3.6), layout="constrained")
    axes = canvas.subplots()
    sigma = t.sigma_rad * 1e6
    axes.loglog(sigma, t.wide_time_s, color=BLUE, label="wide beacon: detection at the edge of its cone")
    axes.loglog(sigma, t.scan_time_s, color=ORANGE, linestyle="--", label="spiral scan: whole area")
    axes.loglog(sigma, t.scan_mean_time_s, color=ORANGE, linestyle=":", label="spiral scan: mean until found")
    axes.axvline(found.sigma_rad * 1e6, color=VERMILION, linewidth=1.0)
    _say(axes, (found.sigma_rad * 1e6, t.scan_time_s[-1]), "this mission", VERMILION, "top")
    axes.set(xlabel="pointing uncertainty, rms per axis (µrad)", ylabel="time (s)")
    axes.grid(visible=True, which="both", linewidth=0.3)
    axes.set_xticks([30, 100, 300, 1000], ["30", "100", "300", "1000"])
    axes.minorticks_off()
    axes.legend(loc="upper left", fontsize=8)
    m = study.file.mission
    assert m.acquisition is not None
    assert m.acquisition.scan is not None
    assert found.scanned is not None
    scan, half = m.acquisition.scan, format_quantity(found.scanned.half_angle_rad, "rad", 3)
    caption = (
        f"Time to be found at {100 * scan.coverage:g} % coverage, without settling and light time. The beacon's "
        "power, spread over a cone that covers the uncertainty, makes the partner's sensor integrate with the fourth "
        f"power of it (noise that does not depend on the light; at least {format_quantity(scan.detection_s, 's')}); "
        f"the same power in a beam of {half} half angle at 1/e2, used out to "
        f"{format_quantity(scan.beam_radius_rad, 'rad')} and led over it with an overlap of {scan.overlap:g} under "
        f"{format_quantity(scan.jitter_rms_rad, 'rad')} of jitter per axis, takes a "
        f"time that grows with its square and finds {100 * float(np.min(t.scan_probability)):.1f} % or more."
    )
    columns = {
        "uncertainty per axis (rad)": t.sigma_rad,
        "wide beacon, time (s)": t.wide_time_s,
        "wide beacon, probability": t.wide_probability,
        "scan, whole time (s)": t.scan_time_s,
        "scan, mean time (s)": t.scan_mean_time_s,
        "scan, probability": t.scan_probability,
    }
    return Figure("wide-beam-or-scan", "Wide beacon or scan", caption, svg_of(canvas), columns)
