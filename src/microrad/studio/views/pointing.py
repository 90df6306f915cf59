"""What the page of the pointing budget shows: lines, totals by each rule, what is left, what the beacon covers."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from microrad import link
from microrad.core.units import format_quantity
from microrad.link import pointing
from microrad.link import study as link_study
from microrad.link.pointing import OpenLoopPointing
from microrad.link.study import PointAheadEffect
from microrad.mission.file import LinkFile
from microrad.report.links import views as links
from microrad.report.links import words
from microrad.report.marks import marked
from microrad.report.plotting.palette import BLACK, BLUE, GREEN, GREY, ORANGE, SKY, VERMILION
from microrad.report.plotting.sheet import Axis, Bars, Line, Mark, Rule, shortened
from microrad.report.quantities import quantity, share_of_time
from microrad.report.view import Block, Soft, View, told
from microrad.studio.draft.draft import Draft
from microrad.studio.views.plots import Plot, plot, rows
from microrad.studio.views.sliders import Slider, grouped

POINTS = 241
"""Of the curve of coverage."""

_CLASSES = {"bias": BLUE, "random": ORANGE, "drift": GREEN, "transient": SKY, "total": GREY}
_LINES = "pointing.lines."
_SOURCES, _REQUIRED = "error_budget.sources.", "error_budget.requirements."
_OTHERS = {
    "beacon.divergence": "Beacon",
    "point_ahead.transverse_velocity": "Point-ahead",
    "point_ahead.error": "Point-ahead",
    "pointing.confidence": "Asked for",
}


@dataclass(frozen=True, slots=True)
class PointingView:
    """The open-loop pointing budget of a mission, and its point-ahead where it has one; and the mission itself."""

    budget: OpenLoopPointing
    ahead: PointAheadEffect | None
    file: LinkFile

    @property
    def half_angle_rad(self) -> float:
        """Of the beacon at 1/e2; nan without one."""
        return math.nan if self.budget.reading is None else self.budget.reading.half_angle_rad


def view(file: LinkFile) -> PointingView:
    """The pointing budget of a mission; raises ValueError as `pointing.open_loop_budget` does."""
    m, data = file.mission, link.of(file.mission)
    p = pointing.open_loop_budget(m.pointing, data.shared, m.beacon, file.sources)
    return PointingView(p, link_study.point_ahead(data), file)


def sliders(draft: Draft) -> dict[str, tuple[Slider, ...]]:
    """The numbers that move the budgets: lines, the beacon's cone, the confidence, point-ahead, sources and limits."""
    groups = ("Errors", *dict.fromkeys(_OTHERS.values()), *_OF_BUDGET)
    found, named = grouped(draft, groups, _group), ("Errors", *_OF_BUDGET)
    return {name: tuple(map(_named, those)) if name in named else those for name, those in found.items()}


_OF_BUDGET = {"Sources": (_SOURCES, (".size", ".rate")), "Limits": (_REQUIRED, (".limit",))}


def _group(key: str) -> str:
    if key.startswith(_LINES) and key.endswith(".error"):
        return "Errors"
    own = (name for name, (begin, ends) in _OF_BUDGET.items() if key.startswith(begin) and key.endswith(ends))
    return next(own, _OTHERS.get(key, ""))


def _named(made: Slider) -> Slider:
    """The slider of a line, a source or a requirement, called by it."""
    begin = next(each for each in (_LINES, _SOURCES, _REQUIRED) if made.key.startswith(each))
    name = made.key.removeprefix(begin).rpartition(".")[0].replace("_", " ").replace("-", " ")
    return replace(made, label=name[:1].upper() + name[1:])


# ------------------------------------------------------------------------------------------------------------- blocks
def blocks(v: PointingView) -> tuple[Block, ...]:
    """The report's view of the budget, and the point-ahead; says of both what a mission does not have."""
    said = links.pointing_view(v.budget)
    bare = "" if v.budget.reading else "The mission has no beacon, so nothing is to be covered."
    ahead = Soft("The mission has no table [point_ahead].") if v.ahead is None else words.point_ahead(v.ahead)
    return tuple(marked(told(bare, *(said.blocks if said else ()), View("Point-ahead", [ahead])), v.file.sources))


# -------------------------------------------------------------------------------------------------------------- plots
def lines_plot(v: PointingView) -> Plot:
    """The half widths of the lines as bars by their class, the totals below them, against the beacon's half angle."""
    lines, totals = v.budget.stated, v.budget.summations
    errors = [(each.kind, each.error_rad) for each in lines] + [("total", each.total_rad) for each in totals]
    marks: list[Mark] = [_bars(kind, errors) for kind in dict.fromkeys(kind for kind, _ in errors)]
    if not math.isnan(v.half_angle_rad):
        name = f"beacon's half angle: {quantity(v.half_angle_rad, 'rad')}"
        marks.append(Rule(v.half_angle_rad * 1e6, True, VERMILION, "--", 1.5, name))
    names = rows([shortened(name, 40) for name in (*(e.name for e in lines), *(e.name for e in totals))])
    return plot(Axis("angle (µrad)", low=0.0), names, *marks, height=1.0 + 0.27 * len(errors))


def _bars(kind: str, errors: list[tuple[str, float]]) -> Bars:
    """The bars of one class, each in the row that it has among all."""
    own = np.array([(row, error_rad * 1e6) for row, (of, error_rad) in enumerate(errors) if of == kind])
    return Bars(own[:, 0], np.zeros(len(own)), own[:, 1], np.full(len(own), 0.7), _CLASSES[kind], label=kind)


def coverage_plot(v: PointingView) -> Plot:
    """Probability that the radial error is below an angle, with what the beacon covers and what the rules ask for."""
    p = v.budget
    totals = {name: p.total_rad(name) for name in ("rss", "ecss-radial", "exact")}
    most = 1.25 * max(end for end in (*totals.values(), v.half_angle_rad) if math.isfinite(end)) or 1e-6
    radius = np.linspace(0.0, most, POINTS)
    marks: list[Mark] = [Line(radius * 1e6, 100.0 * p.coverage(radius), BLUE, width=1.9, label="inside this angle")]
    if not math.isnan(v.half_angle_rad):
        half = f"beacon's half angle: {format_quantity(v.half_angle_rad, 'rad', 3)}"
        marks.append(Rule(v.half_angle_rad * 1e6, True, VERMILION, "-", 1.5, half))
    named = (
        ("root sum square", ORANGE, "--"),
        ("ECSS, two axes", GREEN, "-."),
        (f"{share_of_time(p.confidence)} inside", BLACK, ":"),
    )
    for total_rad, (name, colour, dash) in zip(totals.values(), named, strict=True):
        marks.append(Rule(total_rad * 1e6, True, colour, dash, 1.5, f"{name}: {quantity(total_rad, 'rad')}"))
    x = Axis("angle off the line of sight (µrad)", low=0.0, high=most * 1e6)
    return plot(x, Axis("probability of an error below it (%)", low=0.0, high=101.0), *marks)
