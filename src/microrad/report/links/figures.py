"""Figures of the links: what moves the margin most, and the wide beacon against the scan."""

import math
from collections.abc import Sequence

import numpy as np

from microrad.core.units import format_quantity
from microrad.link import Swing, Tornado
from microrad.link.acquisition.partner_search import Finding
from microrad.link.acquisition.trade import Trade
from microrad.link.fade_series.coded import CodedFading
from microrad.link.requirement import time_kept
from microrad.link.study import LinkStudy
from microrad.report.links import words
from microrad.report.links.ground import over_elevation
from microrad.report.plotting.figure import Figure
from microrad.report.plotting.palette import BLACK, BLUE, ORANGE, VERMILION, WHITE
from microrad.report.plotting.scales import limits
from microrad.report.plotting.sheet import Axis, Legend, Line, Rule, Words, grid
from microrad.report.plotting.swings import swing_bars, swing_legend
from microrad.report.quantities import power_text
from microrad.report.tables import Column

MOST_BARS = 14
_TITLES = {
    "Communication": ("tornado", "What moves the margin"),
    "Beacon": ("tornado-beacon", "What moves the margin of the beacon"),
    "Answer": ("tornado-answer", "What moves the margin of the answer"),
}


def link_figures(study: LinkStudy) -> tuple[Figure, ...]:
    """The figures of the links, in the order of the page."""
    figures = [tornado(study, t) for t in study.tornados if t.swings]
    if study.finding is not None and study.finding.trade is not None:
        figures.append(trade(study, study.finding, study.finding.trade))
    if study.ground is not None and len(study.ground.elevations) > 1:
        figures.append(over_elevation(study, study.ground))
    if study.fading is not None:
        figures.append(interleaver(study, study.fading))
    return tuple(figures)


def tornado(study: LinkStudy, of: Tornado) -> Figure:
    """One margin over each of its inputs, one at a time.

    Args:
        study: the links, at their budgeted errors or under their jitter.
        of: the margin with its inputs, the widest first.
    """
    shown, margin = of.swings[:MOST_BARS], of.margin_db
    sheet, (panel,) = grid(6.4, 0.9 + 0.27 * len(shown))
    lost_db = _lost(shown, margin)
    ends = [(max(swing.margin_low_db, lost_db), max(swing.margin_high_db, lost_db)) for swing in shown]
    swing_bars(panel, [_label(swing) for swing in shown], ends, margin)
    for row, swing in enumerate(shown):
        if not math.isfinite(swing.swing_db):
            ink = WHITE if math.isinf(swing.margin_high_db) else BLACK
            panel.add(Words("< no margin: receiver too slow", lost_db, row, ink, shift=(3.0, 0.0)))
    m, data = study.file.mission, of.of == study.communication.name
    required = m.requirement.margin_db
    low, high = limits(panel.x, "x", [panel])
    if data and low < required < high:
        panel.add(Rule(required, True, VERMILION, "--"))
        panel.add(Words("required", required, -0.55, VERMILION, base="bottom", shift=(3.0, 0.0)))
    judged = f", for {time_kept(m.requirement)}" if data and m.jitter is not None else ""
    panel.x.title = f"margin of the {'communication link' if data else of.of.lower()}{judged} (dB)"
    panel.legend = swing_legend("input", "lower right")
    assumed = [s.key for s in shown if s.kind == "assumption"]
    caption = (
        "Margin with one input at a time 10 % lower and higher, all others as they are. An input in decibels is moved "
        "by 0.5 dB; a bit error ratio or an outage becomes ten times smaller and larger. No input leaves its bounds."
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
    return Figure(name, title, caption, sheet, columns)


def _lost(shown: Sequence[Swing], margin_db: float) -> float:
    """Where the bar of an input ends that leaves no link: beyond all others."""
    ends = [end for s in shown for end in (s.margin_low_db, s.margin_high_db) if math.isfinite(end)]
    reach = max((abs(end - margin_db) for end in ends), default=0.0)
    return margin_db - max(1.5 * reach, 1.0)


def _label(swing: Swing) -> str:
    key = swing.key.removeprefix("communication.")
    return f"{key} = {format_quantity(swing.value, swing.unit, 3)}"


def trade(study: LinkStudy, found: Finding, t: Trade) -> Figure:
    """Section 2.1 of the paper as a picture: a wide beacon, or a scan with a narrow beam.

    Args:
        study: the links, at their budgeted errors or under their jitter.
        found: the search for the partner, which has a scan.
        t: the times of both ways over the uncertainty.
    """
    sheet, (panel,) = grid(6.4, 3.6)
    sigma = t.sigma_rad * 1e6
    panel.add(Line(sigma, t.wide_time_s, BLUE, label="wide beacon: detection at the edge of its cone"))
    panel.add(Line(sigma, t.scan_time_s, ORANGE, "--", label="spiral scan: whole area"))
    panel.add(Line(sigma, t.scan_mean_time_s, ORANGE, ":", label="spiral scan: mean until found"))
    panel.add(Rule(found.sigma_rad * 1e6, True, VERMILION))
    panel.add(Words("this mission", found.sigma_rad * 1e6, t.scan_time_s[-1], VERMILION, base="top", shift=(3.0, 0.0)))
    panel.x = Axis("pointing uncertainty, rms per axis (µrad)", log=True, ticks=(30.0, 100.0, 300.0, 1000.0))
    panel.y, panel.legend = Axis("time (s)", log=True), Legend("upper left")
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
    return Figure("wide-beam-or-scan", "Wide beacon or scan", caption, sheet, columns)


def interleaver(study: LinkStudy, f: CodedFading) -> Figure:
    """What fades cost a coded link against the span of its interleaver.

    Args:
        study: the links.
        f: the coded link under a series of received power.
    """
    sheet, (panel,) = grid(6.4, 3.4)
    span, cost = np.array(f.curve.span_s), np.array(f.curve.penalty_db)
    drawn = np.where(np.isfinite(cost), cost, np.nan)
    panel.add(Line(span[1:] * 1e3, drawn[1:], BLUE, marker="o", size=4.0, label="with an interleaver"))
    if math.isfinite(cost[0]):
        panel.add(Rule(float(cost[0]), False, ORANGE, "--", label="without one"))
    spare = f.margin_db - study.file.mission.requirement.margin_db
    panel.add(Rule(spare, False, VERMILION, ":", label="what the margin can spare"))
    if f.span_s and math.isfinite(f.penalty_db):
        own = np.array([f.span_s * 1e3]), np.array([f.penalty_db])
        panel.add(Line(*own, BLACK, "", marker="D", size=7.0, label="this mission"))
    panel.x = Axis("span of the interleaver (ms)", log=True)
    panel.y, sheet.legend = Axis("power that the fades cost (dB)"), Legend("above", 2)
    caption = (
        f"Extra power that brings the mean bit error ratio back to {power_text(f.target)} under {f.source}, over "
        f"constant power, with {f.code}. A span that is long against the fades lets each code word see all powers that "
        "there are. A span without a point costs more than any power makes up for."
    )
    columns: dict[str, Column] = {"span (s)": span, "power that the fades cost (dB)": cost}
    return Figure(words.INTERLEAVER, "What an interleaver brings", caption, sheet, columns)
