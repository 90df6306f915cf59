"""What the page of the links shows: margins, budgets and margin map of a mission, quick enough to follow a slider."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from microrad import link
from microrad.core.arrays import Floats
from microrad.core.units import format_quantity
from microrad.link import compliance
from microrad.link import study as link_study
from microrad.link.pointing.outage import error_rad, required_error_rad
from microrad.link.study import LinkStudy
from microrad.mission.file import LinkFile
from microrad.mission.model import Source
from microrad.report.links import words
from microrad.report.links.figures import link_figures
from microrad.report.links.standard import standard_view
from microrad.report.links.views import budgets_view, links_views
from microrad.report.marks import Marks, marked
from microrad.report.plotting.palette import VERMILION, WHITE
from microrad.report.plotting.sheet import Axis, Field, Line
from microrad.report.quantities import quantity, signed
from microrad.report.view import Block
from microrad.studio.draft.draft import Draft
from microrad.studio.views.plots import Plot, plot
from microrad.studio.views.sliders import Slider, grouped

TABLES = {
    "terminals": "Telescopes",
    "communication": "Communication",
    "beacon": "Beacon",
    "answer": "Answer",
    "requirement": "Required",
}
"""Tables of the mission whose numbers move the links, and what each is called."""

RATES, ERRORS, EDGES = 65, 61, 385
"""Points of the map along data rate and pointing error, and of the rates between which its contours are read."""

ROUNDING_DB = 1e-9
"""By which a margin may miss what is needed: a rate that was solved for that margin does."""
LEVELS_DB = (-12.0, 18.0)
"""Between which margins the map's colours change."""
_TICKS_DB = range(-12, 19, 6)

_SECOND = ("_loss", "wavelength", "strehl", "wavefront_error", "obscuration", "outage")


@dataclass(frozen=True, slots=True, eq=False)
class Frame:
    """The axes of a margin map, which stand still while a slider moves: data rates (n,) and pointing errors (m,)."""

    data_rate_bit_s: Floats
    pointing_error_rad: Floats

    def holds(self, data: link.DataLink) -> bool:
        """Whether the working point and the required pointing error lie within."""
        rate, error = data.table.data_rate_bit_s, error_rad(data)
        within = self.data_rate_bit_s[0] <= rate <= self.data_rate_bit_s[-1]
        return bool(within and max(error, data.requirement.pointing_error_rad) <= self.pointing_error_rad[-1])


@dataclass(frozen=True, slots=True)
class Margin:
    """The margin of one link and what it needs; a link is met from its need upwards, where it is ``possible``."""

    name: str
    margin_db: float
    required_db: float
    possible: bool = True
    sign: str = ""

    @property
    def met(self) -> bool:
        """Whether the margin is at least what is needed, but for rounding: a rate may be solved for that margin."""
        return self.possible and self.margin_db >= self.required_db - ROUNDING_DB

    @property
    def words(self) -> str:
        """The margin with its sign, and behind it what it rests on less than others do."""
        return f"{signed(self.margin_db, 'dB')} {self.sign}".rstrip()

    @property
    def needs(self) -> str:
        """What is needed, and whether it is there."""
        if not self.possible:
            return "MISSED: more light arrives than was sent"
        return f"needs {self.required_db:g} dB: {'met' if self.met else 'MISSED'}"


@dataclass(frozen=True, slots=True, eq=False)
class LinkView:
    """The links of a mission as the page shows them at once.

    `margin_db` is the map over the frame, shape (rates, errors). `contours` gives for each level in dB the largest data
    rate at each pointing error, nan where the frame has none.
    """

    data: link.DataLink
    frame: Frame
    budgets: tuple[link.LinkBudget, ...]
    margin_db: Floats
    contours: dict[float, Floats]
    sources: Mapping[str, Source]

    @property
    def margins(self) -> tuple[Margin, ...]:
        """Each link against what it needs: the communication link its required margin, the others 0 dB."""
        needed = (self.data.requirement.margin_db, *[0.0] * len(self.budgets))
        pairs = zip(self.budgets, needed, strict=False)
        sign = Marks.of(self.sources).sign
        return tuple(
            Margin(b.name, b.margin_db, need, b.possible, sign(f"budgets.{b.name}.margin_db").sign) for b, need in pairs
        )


# ---------------------------------------------------------------------------------------------------------- computing
def view(file: LinkFile, frame: Frame | None = None) -> LinkView:
    """Budgets and margin map of a mission.

    Raises ValueError with the reason when a receiver does not take the data rate, and when no rate has the required
    margin where one is to be solved for.

    Args:
        file: the mission.
        frame: the axes to keep, if the working point lies within.
    """
    file = link_study.solve_rate(file)
    m, sources, data = file.mission, file.sources, link.of(file.mission)
    frame = frame if frame is not None and frame.holds(data) else frame_of(data)
    budgets = [link_study.communication_budget(data, sources)]
    beams = (("beacon", m.beacon), ("answer", m.answer))
    budgets += [link.beam_budget(name, data.shared, beam, sources) for name, beam in beams if beam is not None]
    margin = link.margin_map(data, frame.data_rate_bit_s, frame.pointing_error_rad)
    levels = dict.fromkeys((0.0, data.requirement.margin_db))
    contours = {level: contour(data, frame, level) for level in levels}
    return LinkView(data, frame, tuple(budgets), margin, contours, sources)


def frame_of(data: link.DataLink) -> Frame:
    """Axes about the working point, at round places, so that a small step outside does not move them all the time."""
    built, rate = data.receiver, data.table.data_rate_bit_s
    highest = math.inf if built is None else built.highest_data_rate_bit_s
    low, high = 10.0 ** math.floor(math.log10(rate) - 1.0), min(10.0 ** math.ceil(math.log10(rate) + 1.0), highest)
    most = 3.0 * max(data.requirement.pointing_error_rad, error_rad(data))
    return Frame(np.geomspace(low, high, RATES), np.linspace(0.0, most, ERRORS))


def contour(data: link.DataLink, frame: Frame, level_db: float) -> Floats:
    """Largest data rate (bit/s) with a margin of `level_db` at each pointing error of the frame, nan where none is.

    Rate and error move the margin apart from each other, so that one row and one column of the map hold it; it falls
    with the rate.

    Args:
        data: the communication link.
        frame: axes of the map.
        level_db: the margin (dB).
    """
    rates = np.geomspace(frame.data_rate_bit_s[0], frame.data_rate_bit_s[-1], EDGES)
    on_axis = link.margin_map(data, rates, 0.0)[:, 0]
    lost = on_axis[0] - link.margin_map(data, rates[0], frame.pointing_error_rad)[0]
    found = np.interp(-(level_db + lost), -on_axis, np.log(rates), left=np.nan, right=np.nan)
    largest: Floats = np.exp(found)
    return largest


def sliders(draft: Draft) -> dict[str, tuple[Slider, ...]]:
    """The numbers of the links' tables by what their table is called, in the order of the text."""
    return grouped(
        draft, TABLES.values(), lambda key: TABLES.get(key.partition(".")[0], "") if key.count(".") < 2 else ""
    )


def second(key: str) -> bool:
    """Whether a number is one that is seldom moved, and stands behind the others."""
    return key.endswith(_SECOND)


# ------------------------------------------------------------------------------------------------------------ showing
def map_plot(v: LinkView) -> Plot:
    """The margin map with its contours and the working point, over data rate and pointing error."""
    rate_mbit, urad = v.frame.data_rate_bit_s * 1e-6, v.frame.pointing_error_rad * 1e6
    margin_db: Floats = np.round(np.clip(v.margin_db.T, -999.0, 999.0), 2).astype(np.float64)
    here = np.array([v.data.table.data_rate_bit_s * 1e-6]), np.array([error_rad(v.data) * 1e6])
    made = plot(
        Axis("data rate (Mbit/s)", log=True, low=rate_mbit[0], high=rate_mbit[-1], grid=False),
        Axis("pointing error (µrad)", low=0.0, high=urad[-1], grid=False),
        Field(
            rate_mbit,
            urad,
            margin_db,
            *LEVELS_DB,
            "margin (dB)",
            ticks=_TICKS_DB,
        ),
        *(_contour(level, rates * 1e-6, urad, v.data.requirement.margin_db) for level, rates in v.contours.items()),
        Line(*here, VERMILION, "", name="working point", marker="o", size=10.0, edge=WHITE, edge_width=1.5),
        height=4.5,
    )
    made["data"][0]["zsmooth"] = "best"
    made["layout"]["uirevision"] = "map"  # what is zoomed into stays while a slider moves
    made["layout"]["yaxis"]["automargin"] = False  # measuring the margins anew takes as long as drawing
    return made


def _contour(level_db: float, rate_mbit: Floats, urad: Floats, required_db: float) -> Line:
    """A contour, nan where the frame has none; that of the required margin is solid."""
    dash, width = ("-", 2.2) if level_db == required_db else ("--", 1.5)
    return Line(rate_mbit, urad, WHITE, dash, width, name=f"{level_db:g} dB")


def map_key(required: float) -> str:
    """What the lines and the dot of the map are, at a required margin (dB)."""
    none = "" if required == 0.0 else " Dashed line: 0 dB."
    return f"Solid line: the required {required:g} dB.{none} Dot: the working point."


def map_words(v: LinkView) -> str:
    """What the map says, in words, for a reader who does not see it."""
    q, c = v.data.requirement, v.data.table
    there = _largest(v.data)
    return (
        f"At {format_quantity(c.data_rate_bit_s, 'bit/s')} and {format_quantity(error_rad(v.data), 'rad')} the "
        f"communication link has {signed(v.budgets[0].margin_db, 'dB')}. {there} for the required {q.margin_db:g} dB."
    )


def _largest(data: link.DataLink) -> str:
    """The requirement solved in both directions, in words."""
    q, rate = data.requirement, data.table.data_rate_bit_s
    fastest = link_study.largest_rate(data)
    at = f"at {format_quantity(required_error_rad(data), 'rad')}"
    most = f"No data rate will do {at}" if math.isnan(fastest) else f"At most {quantity(fastest, 'bit/s')} {at}"
    try:
        error = link.largest_pointing_error(data, q.margin_db, rate)
    except link.LinkError:
        return f"{most}, and no pointing error at {format_quantity(rate, 'bit/s')},"
    return f"{most}, or {quantity(error, 'rad')} at {format_quantity(rate, 'bit/s')},"


# --------------------------------------------------------------------------------------------------- the slower things
def blocks(study: LinkStudy) -> tuple[Block, ...]:
    """The report's views of the links but for the pointing, which has a page, and the lines of the budgets.

    Behind them stands each standard that is known, folded.
    """
    figures, own = link_figures(study), replace(study, open_loop=None)
    budgets, *others = links_views(own, figures, budgets=budgets_view(study, (), figures))
    held = (compliance.compliance(study, compliance.standard(name)) for name in compliance.standards())
    standards = (replace(standard_view(each), folded=True) for each in held)
    return tuple(marked((words.verdict(study), *budgets.blocks, *others, *standards), study.file.sources))
