"""The two forms of a figure: each record of a sheet is in the picture and in what plotly gets, small and harmless."""

import itertools
import json
import math
import re
import textwrap
import xml.etree.ElementTree as ET
from dataclasses import replace

import numpy as np
import pytest

from microrad.report.day.figures import Assumed, assumptions, empty
from microrad.report.page import templates as scripts
from microrad.report.page.templates import templates
from microrad.report.plotting import interactive, scales
from microrad.report.plotting.figure import Figure
from microrad.report.plotting.interactive import numbers, plot_of, spoken, text_of, words
from microrad.report.plotting.layout import layout
from microrad.report.plotting.palette import (
    BLACK,
    BLUE,
    CIVIDIS,
    GREY,
    MOST_POINTS,
    ORANGE,
    SKY,
    VERMILION,
    WHITE,
    colour_at,
    thinned,
    thinned_by_logarithm,
)
from microrad.report.plotting.sheet import (
    Area,
    Axis,
    Bars,
    Field,
    Legend,
    Line,
    Panel,
    Rule,
    Sheet,
    Span,
    Words,
    between,
    contour,
    grid,
    region,
    rows,
    segments,
    shortened,
    stairs,
)
from microrad.report.plotting.svg import svg_of
from microrad.report.plotting.swings import in_lines, swing_bars, swing_legend
from microrad.report.tables import rows_of
from report_pages import assert_sound
from shipped import plain_drawn

HOSTILE = '</script><b onclick="x()">&amp; %{x} <a href="https://example.org">link</a>'
SVG = "{http://www.w3.org/2000/svg}"
X, Y = np.array([0.0, 1.0, 2.0]), np.array([3.0, 4.0, 5.0])


def turned(sheet):
    """The interactive form; it is plain data."""
    return json.loads(text_of(plot_of(sheet)))


def only(plot):
    (trace,) = plot["data"]
    return trace


def one(*marks, **axes):
    """A sheet with one panel."""
    sheet, (panel,) = grid(6.4, 4.0)
    panel.add(*marks)
    for which, values in axes.items():
        for key, value in values.items():
            setattr(getattr(panel, which), key, value)
    return sheet


def parts(sheet, tag):
    return list(ET.fromstring(svg_of(sheet)).iter(f"{SVG}{tag}"))


def texts(sheet):
    return ["".join(each.itertext()) for each in parts(sheet, "text")]


def points(path):
    """Corners of a path of straight lines, in points from the sheet's corner; a gap begins a new list."""
    return [
        np.array([[float(n) for n in each.split()] for each in part.strip("LZ").replace("Z", "").split("L")])
        for part in path.split("M")[1:]
    ]


# ------------------------------------------------------------------------------------------------ marks
def test_a_line_keeps_its_points_gaps_colour_width_and_dashes_in_both_forms():
    broken = Line(X, np.array([3.0, math.nan, 5.0]), BLUE, "--", 1.5, "one")
    own = Line(X, Y, VERMILION, (5.0, 2.0), 3.0)
    sheet = one(broken, own, x={"title": "time (s)"}, y={"title": "rms, one axis (µrad)"})
    first, second = turned(sheet)["data"]
    assert (first["x"], first["y"], first["name"]) == ([0, 1, 2], [3, None, 5], "one")
    assert first["line"] == {"color": "#0072B2", "width": 2.0, "dash": "dash", "shape": "linear", "simplify": False}
    assert (second["line"]["dash"], second["name"]) == ("20px,8px", "")
    assert first["hovertemplate"].startswith("time: %{x:.5~g} s<br>rms, one axis: %{y:.5~g} µrad<extra>")
    (placed,) = layout(sheet).placed
    drawn = {each.get("stroke"): each for each in parts(sheet, "path")}
    assert [len(part) for part in points(drawn[BLUE].get("d"))] == [1, 1]
    assert (drawn[VERMILION].get("stroke-dasharray"), drawn[VERMILION].get("stroke-width")) == ("15 6", "3")
    (line,) = points(drawn[VERMILION].get("d"))
    left, top, right, bottom = placed.inner
    across = (line[:, 0] - left) / (right - left) * (placed.x_ends[1] - placed.x_ends[0]) + placed.x_ends[0]
    up = (bottom - line[:, 1]) / (bottom - top) * (placed.y_ends[1] - placed.y_ends[0]) + placed.y_ends[0]
    assert across == pytest.approx(X, abs=1e-3)
    assert up == pytest.approx(Y, abs=1e-3)


def test_steps_stay_steps():
    sheet = one(Line(X, Y, steps=True))
    assert only(turned(sheet))["line"]["shape"] == "hv"
    (corners,) = points(next(each.get("d") for each in parts(sheet, "path") if each.get("stroke-width") == "1.3"))
    assert len(corners) == 5
    assert all(a[0] == b[0] or a[1] == b[1] for a, b in itertools.pairwise(corners))


@pytest.mark.parametrize(
    ("marker", "symbol"),
    [
        ("o", "circle"),
        ("s", "square"),
        ("D", "diamond"),
        ("^", "triangle-up"),
        ("x", "x-thin-open"),
        ("|", "line-ns-open"),
    ],
)
def test_markers_stand_where_they_stand(marker, symbol):
    sheet = one(Line(X, Y, BLUE, "", marker=marker, size=9.0, edge=WHITE))
    trace = only(turned(sheet))
    assert (trace["mode"], trace["x"], trace["marker"]["symbol"], trace["marker"]["size"]) == (
        "markers",
        [0, 1, 2],
        symbol,
        12.0,
    )
    shapes = next(each.get("d") for each in parts(sheet, "path") if each.get("stroke") == WHITE)
    assert shapes.count("M") == 3
    assert len(turned(one(Line(X, Y, marker="o", every=[1])))["data"][1]["x"]) == 1
    hollow = only(turned(one(Line(X, Y, BLUE, "", marker="o", face=""))))["marker"]
    assert (hollow["symbol"], hollow["color"]) == ("circle-open", BLUE)


def test_a_curve_that_no_legend_shows_may_have_a_name():
    assert only(turned(one(Line(X, Y, name="predicted"))))["name"] == "predicted"
    assert only(turned(one(Line(X, Y, BLUE, "", marker="o", name="working point"))))["name"] == "working point"


def test_error_bars_keep_both_arms():
    arms = np.array([[0.1, 0.2, 0.3], [0.4, 0.5, 0.6]])
    sheet = one(Line(X, Y, BLUE, "", marker="o", x_arms=arms))
    found = only(turned(sheet))["error_x"]
    assert (found["arrayminus"], found["array"]) == ([0.1, 0.2, 0.3], [0.4, 0.5, 0.6])
    bars = next(
        each.get("d") for each in parts(sheet, "path") if each.get("stroke") == BLUE and each.get("fill") == "none"
    )
    assert bars.count("M") == 3 * 3  # each bar with two caps
    left, right = np.array(re.findall(r"M([\d.]+) [\d.]+L([\d.]+)", bars), dtype=float).T
    ends, places = np.concatenate([X - arms[0], X + arms[1]]), np.concatenate([left, right])
    assert np.polyval(np.polyfit(ends, places, 1), ends) == pytest.approx(places, abs=0.02)  # of a rounded place
    assert layout(sheet).placed[0].x_ends[0] < -0.1


def test_an_area_between_curves_is_its_outline_and_parted_at_gaps():
    area = between(X, np.array([0.0, math.nan, 1.0]), np.array([1.0, 2.0, 3.0]), SKY, 0.5, "band")
    assert [len(ring) for ring in area.rings] == [2, 2]
    sheet = one(between(X, Y, Y + 1.0, SKY, 0.5, "band"))
    (shape,) = turned(sheet)["layout"]["shapes"]
    assert shape["path"] == "M0,3L1,4L2,5L2,6L1,5L0,4Z"
    assert shape["fillcolor"] == "rgba(86,180,233,0.5)"
    (drawn,) = [each for each in parts(sheet, "path") if each.get("fill") == SKY]
    assert drawn.get("fill-opacity") == "0.5"


def test_bars_of_one_colour_are_one_trace_and_name_their_rows():
    bars = Bars(np.array([0.0, 1.0]), np.zeros(2), np.array([3.0, 5.0]), np.full(2, 0.6), BLUE, label="first")
    sheet = one(bars, x={"title": "index (1)"}, y={"ticks": {0: "alpha", 1: "beta"}, "low": 1.4, "high": -0.6})
    plot = turned(sheet)
    trace = only(plot)
    assert (trace["orientation"], trace["x"], trace["base"], trace["width"]) == ("h", [3, 5], [0, 0], [0.6, 0.6])
    assert trace["hovertext"] == ["alpha<br>index: 3 1", "beta<br>index: 5 1"]
    assert plot["layout"]["yaxis"]["ticktext"] == ["alpha", "beta"]
    assert plot["layout"]["yaxis"]["range"] == [1.4, -0.6]
    (drawn,) = [each.get("d") for each in parts(sheet, "path") if each.get("fill") == BLUE]
    assert drawn.count("M") == 2
    assert layout(sheet).placed[0].x_ends[0] == 0.0  # bars stand on the axis


def test_segments_and_histograms():
    strokes = segments(X, 0.0, Y, BLACK, 1.0)
    assert np.array_equal(strokes.y[:6], [0.0, 3.0, math.nan, 0.0, 4.0, math.nan], equal_nan=True)
    many = segments(np.arange(999.0), 0.0, np.ones(999), BLACK, 1.0)
    assert only(turned(one(many)))["x"][::3] == [*range(999)]  # none is left out: two of them would make a diagonal
    bars, outline = stairs(np.array([0.0, 1.0, 3.0]), np.array([2.0, 4.0]), SKY, BLUE)
    trace = turned(one(bars, outline, x={"title": "error (µrad)"}, y={"title": "rows (%)"}))["data"][0]
    assert (trace["y"], trace["x"], trace["width"]) == ([2, 4], [0.5, 2], [1, 2])
    assert trace["hovertext"] == ["error: 0 to 1 µrad<br>rows: 2 %", "error: 1 to 3 µrad<br>rows: 4 %"]
    assert (outline.y[0], outline.y[-1]) == (0.0, 0.0)


def test_a_field_keeps_every_value_at_its_place_with_its_words():
    values = np.array([[1.0, math.nan, 3.0], [4.0, 5.0, 6.0]])
    sheet = one(Field(X, np.array([0.0, 1.0]), values, 1.0, 6.0, "margin (dB)"), y={"ticks": {0: "low", 1: "high"}})
    plot = turned(sheet)
    trace = only(plot)
    assert trace["z"] == [[1, None, 3], [4, 5, 6]]
    assert (trace["zmin"], trace["zmax"], trace["text"][1][0]) == (1, 6, "high")
    assert "margin: %{z:.5~g} dB" in trace["hovertemplate"]
    assert trace["colorbar"]["title"]["text"] == "margin (dB)"
    assert plot["scales"][0]["trace"] == 0
    cells = [each for each in parts(sheet, "rect") if each.get("stroke") == each.get("fill")]
    assert len(cells) == 5
    assert {"margin (dB)", "low", "high"} <= set(texts(sheet))
    assert layout(sheet).placed[0].x_ends == (-0.5, 2.5)


def test_colours_of_values_are_those_of_the_table_and_between():
    assert (colour_at(0.0), colour_at(1.0), colour_at(-3.0), colour_at(9.0)) == (CIVIDIS[0], CIVIDIS[-1]) * 2
    assert colour_at(0.5) == CIVIDIS[8]
    assert colour_at(0.5 / 16.0) == "#00285c"


def test_contours_keep_values_levels_and_hatching():
    x, y = np.linspace(0.0, 4.0, 41), np.linspace(0.0, 2.0, 21)
    z = np.add.outer(y, x)
    curve = contour(x, y, z, 3.0)
    assert np.nansum(np.abs(curve[0] + curve[1] - 3.0)) == pytest.approx(0.0, abs=1e-9)
    rings = region(x, y, z, 2.0, 3.0)
    assert all(np.all((ring.sum(axis=1) >= 2.0 - 1e-9) & (ring.sum(axis=1) <= 3.0 + 1e-9)) for ring in rings)
    levels = np.array([0.0, 2.0, 4.0, 6.0])
    sheet = one(
        Field(x, y, z, 0.0, 6.0, "sum (1)", levels), Area(rings, BLACK, hatched=True), Line(*curve, WHITE, name="3")
    )
    field, hatched, line = turned(sheet)["data"]
    assert (field["type"], field["contours"]) == ("contour", {"start": 0, "end": 6, "size": 2, "coloring": "fill"})
    assert hatched["fillpattern"]["shape"] == "/"
    assert (line["name"], line["line"]["color"]) == ("3", WHITE)
    assert 'fill="url(#hatch)"' in svg_of(sheet)
    assert contour(x, y, z, 99.0)[0].size == 0


def test_lines_and_spans_over_the_panel_go_on_when_one_zooms_out():
    sheet = one(Line(X, Y), Rule(1.0, True, BLUE, ":", label="required"), Span(3.5, 4.0, False, SKY), y={"log": True})
    across, span = turned(sheet)["layout"]["shapes"]
    assert (across["x0"], across["x1"], across["y0"], across["y1"], across["yref"]) == (1, 1, 0, 1, "y domain")
    assert (span["y0"], span["y1"], span["yref"], span["xref"]) == (3.5, 4, "y", "x domain")
    assert across["line"]["dash"] == "dot"


def test_a_span_without_an_end_goes_to_that_of_the_panel():
    sheet = one(Line(X, Y), Span(-math.inf, 1.0, True, SKY), Span(1.5, math.inf, True, SKY), x={"low": -1.0})
    (placed,) = layout(sheet).placed
    shapes = turned(sheet)["layout"]["shapes"]
    assert [(each["x0"], each["x1"]) for each in shapes] == [(-1, 1), (1.5, placed.x_ends[1])]
    assert placed.x_ends[1] == pytest.approx(2.1)  # it asks for no room
    rects = [each for each in parts(sheet, "rect") if each.get("fill") == SKY]
    ends = [(float(each.get("x")), float(each.get("x")) + float(each.get("width"))) for each in rects]
    assert (ends[0][0], ends[1][1]) == pytest.approx((placed.inner[0], placed.inner[2]), abs=0.02)


def test_texts_stand_where_they_stand():
    inside = Words("here", 1.0, 4.0, GREY, anchor="middle", base="bottom", shift=(3.0, 1.5), box=True)
    sheet = one(Line(X, Y), inside, Words("beside", 1.0, 4.0, of_panel="x", shift=(5.0, 0.0)), x={"log": True})
    first, second = turned(sheet)["layout"]["annotations"]
    assert (first["x"], first["y"], first["xref"], first["xshift"]) == (0, 4, "x", 4.0)
    assert (first["xanchor"], first["yanchor"], first["bgcolor"]) == ("center", "bottom", "rgba(255,255,255,0.75)")
    assert (second["x"], second["xref"], second["yref"]) == (1, "x domain", "y")
    assert {"here", "beside"} <= set(texts(sheet))
    (placed,) = layout(sheet).placed
    assert placed.outer[2] - placed.inner[2] > scales.width_of("beside", 8.0)  # room for it at the right


# ------------------------------------------------------------------------------------------------ axes and layout
def test_axes_keep_scale_limits_order_and_words():
    sheet = one(
        Line(X + 1.0, Y),
        x={"log": True, "low": 1.0, "high": 1000.0, "title": "frequency (Hz)"},
        y={"ticks": {3.0: "three", 4.5: "x"}, "low": 5.0, "high": 2.0},
    )
    x, y = (turned(sheet)["layout"][key] for key in ("xaxis", "yaxis"))
    assert (x["type"], x["range"], x["title"]["text"]) == ("log", [0, 3], "frequency (Hz)")
    assert (y["range"], y["tickvals"], y["ticktext"]) == ([5, 2], [3, 4.5], ["three", "x"])
    assert {"1", "10", "100", "1000", "three", "x"} <= set(texts(sheet))


@pytest.mark.parametrize(("low", "plain"), [(0.1, True), (8e-4, True), (1e-6, False)])
def test_a_logarithmic_axis_has_plain_numbers_or_powers_of_ten_in_both_forms(low, plain):
    sheet = one(Line(X, Y), y={"log": True, "low": low, "high": 100.0})
    axis = turned(sheet)["layout"]["yaxis"]
    assert (axis.get("tickformat"), axis.get("exponentformat")) == (("~g", None) if plain else (None, "power"))
    assert ("0.1" in texts(sheet)) == plain
    assert ("10⁻⁴" in texts(sheet)) != plain
    assert axis["tickfont"]["size"] == (12 if plain else 9.6)  # plotly sets powers larger by a quarter


@pytest.mark.parametrize(
    ("low", "high", "most", "found"),
    [
        (0.0, 10.0, 6, ["0", "2", "4", "6", "8", "10"]),
        (-0.31, 0.29, 5, ["−0.2", "0", "0.2"]),
        (1.9e-5, 8.2e-5, 4, ["2×10⁻⁵", "4×10⁻⁵", "6×10⁻⁵", "8×10⁻⁵"]),
        (5.0, 5.0, 5, ["5"]),
        (990.0, 1010.0, 5, ["990", "995", "1000", "1005", "1010"]),
    ],
)
def test_round_ticks(low, high, most, found):
    at = scales.rounds(low, high, most)
    assert scales.texts(at) == found
    assert all(low <= each <= high for each in at)


@pytest.mark.parametrize(
    ("low", "high", "most", "found"),
    [
        (0.5, 2000.0, 9, ["1", "10", "100", "1000"]),
        (1e-9, 1.0, 5, ["10⁻⁸", "10⁻⁶", "10⁻⁴", "10⁻²", "10⁰"]),
        (20.0, 300.0, 9, ["20", "30", "50", "70", "100", "200", "300"]),
        (2.1, 2.4, 5, ["2.1", "2.2", "2.3", "2.4"]),
    ],
)
def test_ticks_of_a_logarithmic_axis(low, high, most, found):
    assert scales.powers(scales.decades(low, high, most)) == found


@pytest.mark.parametrize("values", [[], [math.nan], [3.0], [0.0, 0.0], [-1e-300, 1e300], [1e9, 1e9 + 1e-3]])
@pytest.mark.parametrize("log", [False, True])
def test_limits_are_finite_and_apart_whatever_is_drawn(values, log):
    y = np.array(values, dtype=np.float64)
    low, high = scales.limits(Axis(log=log), "y", [Panel(0, 0, marks=[Line(y, y)])])
    assert math.isfinite(low)
    assert math.isfinite(high)
    assert low < high
    svg_of(one(Line(y, y), y={"log": log}))


@pytest.mark.parametrize(
    ("at", "found"),
    [
        ([], []),
        ([0.0], ["0"]),
        ([0.0, 0.001], ["0", "0.001"]),
        ([0.0, 0.0009], ["0", "9×10⁻⁴"]),
        ([0.0, 9_999_999.0], ["0", "9999999"]),
        ([0.0, 10_000_000.0], ["0", "10⁷"]),
        ([-0.5, 0.25], ["−0.50", "0.25"]),
        ([1.0, 1.0 + 1e-10], ["1", "1"]),
        ([1.0, 1.5, 2.25], ["1.00", "1.50", "2.25"]),
    ],
)
def test_ticks_have_the_same_decimals_and_powers_of_ten_from_a_thousandth_and_from_ten_million_on(at, found):
    assert scales.texts(at) == found


@pytest.mark.parametrize(
    ("numbers_", "plain"), [([1e-3, 1e4], True), ([9e-4], False), ([1.1e4], False), ([1.0, 1e5], False), ([], True)]
)
def test_numbers_of_a_logarithmic_axis_are_plain_from_a_thousandth_to_ten_thousand(numbers_, plain):
    assert scales.plain(numbers_) is plain


@pytest.mark.parametrize(
    ("ends", "ticks", "log", "found"),
    [
        ((1.0, 10.0), None, True, [float(k) for k in range(1, 11)]),
        ((10.0, 1.0), None, True, [float(k) for k in range(1, 11)]),
        ((2.0, 5.0), None, True, [2.0, 3.0, 4.0, 5.0]),
        ((2.5, 4.5), None, True, [3.0, 4.0]),
        ((1.0, 10.0), None, False, []),
        ((1.0, 10.0), [1.0], True, []),
        ((1.0, 1.1e6), None, True, []),
    ],
)
def test_ticks_without_a_text_stand_on_logarithmic_axes_alone_ends_and_all(ends, ticks, log, found):
    assert scales.minor(Axis(log=log, ticks=ticks), ends) == pytest.approx(found)


def test_six_decades_have_ticks_between_and_more_have_none():
    assert len(scales.minor(Axis(log=True), (1.0, 1e6))) == 55
    assert scales.minor(Axis(log=True), (1.0, 1e6 * (1.0 + 1e-9))) == []


@pytest.mark.parametrize(
    ("low", "high", "most", "found"),
    [
        (1.0, 100.0, 9, [1.0, 10.0, 100.0]),  # the ends themselves
        (1.0, 10.0, 9, [1.0, 2.0, 3.0, 5.0, 7.0, 10.0]),
        (1.0, 10.0, 5, [1.0, 2.0, 5.0, 10.0]),
        (1.0, 10.0, 3, [1.0, 3.0, 10.0]),
        (1.0, 10.0, 2, [1.0, 10.0]),
        (1.1, 99.0, 9, [2.0, 3.0, 5.0, 7.0, 10.0, 20.0, 30.0, 50.0, 70.0]),
        (1.0, 1e4, 2, [1.0, 1e3]),
        (1.0, 1e3, 4, [1.0, 10.0, 100.0, 1e3]),
        (1.0, 1e3, 3, [1.0, 100.0]),
        (10.0, 1e3, 2, [10.0, 1e3]),  # one alone would tell no scale
        (10.0, 1e5, 2, [10.0, 1e5]),
    ],
)
def test_ticks_of_a_logarithmic_axis_take_its_ends_and_are_no_more_than_there_may_be(low, high, most, found):
    assert scales.decades(low, high, most) == pytest.approx(found)


@pytest.mark.parametrize(
    ("low", "high", "most", "found"),
    [
        (0.0, 1.0, 11, [0.1 * k for k in range(11)]),
        (0.0, 1.0, 10, [0.0, 0.2, 0.4, 0.6, 0.8, 1.0]),
        (0.0, 1.0, 5, [0.0, 0.25, 0.5, 0.75, 1.0]),
        (0.0, 1.0, 2, [0.0, 1.0]),
        (3.0, 2.0, 5, [3.0]),
    ],
)
def test_round_ticks_take_the_ends_and_are_no_more_than_there_may_be(low, high, most, found):
    assert scales.rounds(low, high, most) == pytest.approx(found)


def test_ticks_that_are_set_are_those_within_the_ends():
    assert scales.ticks(Axis(ticks=[0.0, 1.0, 2.0, 2.1]), "x", (2.0, 0.0), 100.0) == {0.0: "0", 1.0: "1", 2.0: "2"}
    words_ = {-1.0: "before", 0.0: "first", 2.0: "last"}
    assert scales.ticks(Axis(ticks=words_), "y", (0.0, 2.0), 100.0) == {0.0: "first", 2.0: "last"}
    assert scales.ticks(Axis(ticks=[-0.1, 5.0]), "y", (0.0, 2.0), 100.0) == {}


@pytest.mark.parametrize(
    ("length", "which", "count"), [(40.0, "y", 2), (250.0, "y", 11), (250.0, "x", 6), (1.0, "x", 2)]
)
def test_there_are_as_many_ticks_as_have_room(length, which, count):
    assert len(scales.ticks(Axis(most=20), which, (0.0, 10.0), length)) == count


@pytest.mark.parametrize(
    ("text", "width", "height"),
    [
        ("", 0.0, 0.0),
        ("0", 6.4, 12.0),
        ("0\n00", 12.8, 24.0),
        (" ~", 11.6, 12.0),
        ("\x7f", 6.6, 12.0),
        ("漢ｘé", 26.6, 12.0),
    ],
)
def test_a_text_is_as_wide_as_its_longest_line_and_wide_letters_are_wide(text, width, height):
    assert (scales.width_of(text, 10.0), scales.height_of(text, 10.0)) == pytest.approx((width, height))


@pytest.mark.parametrize(
    ("log", "low", "high", "found"),
    [
        (False, None, None, (0.95, 2.05)),
        (False, 0.5, None, (0.5, 2.05)),
        (False, None, 3.0, (0.95, 3.0)),
        (False, 3.0, -1.0, (3.0, -1.0)),
        (True, None, None, (2.0**-0.05, 2.0**1.05)),
        (True, 0.0, 4.0, (2.0**-0.05, 4.0)),  # 0 is no end of a logarithmic axis
    ],
)
def test_an_axis_has_its_own_ends_and_else_those_of_the_data_with_a_margin(log, low, high, found):
    panels = [Panel(0, 0, marks=[Line(X, np.array([1.0, math.nan, 2.0]))]), Panel(0, 1, marks=[Words("far", 9.0, 9.0)])]
    assert scales.limits(Axis(log=log, low=low, high=high), "y", panels) == pytest.approx(found)


def test_a_logarithmic_axis_passes_by_data_that_are_not_positive():
    values = np.array([0.0, 1.0, -2.0, 10.0])
    limits = [scales.limits(Axis(log=log), "y", [Panel(0, 0, marks=[Line(values, values)])]) for log in (True, False)]
    assert limits[0] == pytest.approx((10.0**-0.05, 10.0**1.05))
    assert limits[1] == pytest.approx((-2.6, 10.6))


def test_a_single_value_stands_in_the_middle_of_its_axis():
    for value, log, found in ((3.0, False, (1.5, 4.5)), (0.0, False, (-0.5, 0.5))):
        marks = [Rule(value, False), Span(-math.inf, math.inf, False, SKY)]
        assert scales.limits(Axis(log=log), "y", [Panel(0, 0, marks=marks)]) == pytest.approx(found, rel=1e-3)


def test_arms_bars_and_fields_are_within_the_limits():
    two = np.array([1.0, 2.0])
    bars = Bars(two, np.zeros(2), np.array([3.0, -4.0]), np.array([0.5, 0.5]), BLUE, upright=True)
    field = Field(two, np.array([5.0]), np.zeros((1, 2)), 0.0, 1.0)
    arms = np.array([[0.5, 0.5], [2.0, 2.0]])

    def ends(which, *marks):
        return scales.limits(Axis(), which, [Panel(0, 0, marks=list(marks))])

    assert ends("x", bars) == pytest.approx((0.75 - 0.075, 2.25 + 0.075))
    assert ends("y", bars) == pytest.approx((-4.35, 3.35))
    assert (ends("x", field), ends("y", field)) == (pytest.approx((0.5, 2.5)), pytest.approx((4.5, 5.5)))
    assert ends("x", replace(field, levels=np.array([0.0, 1.0]))) == (1.0, 2.0)
    assert ends("y", replace(field, levels=np.array([0.0, 1.0]))) == pytest.approx((4.5, 5.5))
    assert ends("y", Line(two, two, y_arms=arms)) == pytest.approx((0.5 - 0.175, 4.0 + 0.175))
    assert ends("x", Line(two, two, x_arms=arms)) == pytest.approx((0.5 - 0.175, 4.0 + 0.175))


@pytest.mark.parametrize(
    ("start", "end", "found"),
    [
        ([0.0, 0.0], [1.0, 2.0], (0.0, 2.1)),  # they stand on the lower end
        ([0.0, 0.0], [-1.0, -2.0], (-2.1, 0.0)),
        ([0.0, 0.5], [1.0, 2.0], (-0.1, 2.1)),
        ([], [], (-0.05, 1.05)),
    ],
)
def test_there_is_no_margin_where_all_bars_stand_on_the_end(start, end, found):
    bars = Bars(np.arange(len(start)) * 1.0, np.array(start), np.array(end), np.ones(len(start)), BLUE)
    assert scales.limits(Axis(), "x", [Panel(0, 0, marks=[bars])]) == pytest.approx(found)


def test_texts_below_an_axis_stand_apart_and_nothing_leaves_the_sheet():
    sheet = one(
        Line(np.array([36000.001, 36000.009]), np.array([0.0, 1e6])), x={"title": "a (m)"}, y={"title": "b (m)"}
    )
    (placed,) = layout(sheet).placed
    at = [
        (scales.place(placed.panel.x, each, placed.x_ends) * placed.size[0], text)
        for each, text in placed.x_ticks.items()
    ]
    assert len(at) > 1
    for (a, left), (b, right) in itertools.pairwise(at):
        assert b - a > (scales.width_of(left, 9.0) + scales.width_of(right, 9.0)) / 2.0
    assert placed.outer[0] >= 0.0
    assert placed.outer[2] <= 6.4 * 72.0
    assert placed.outer[3] <= 4.0 * 72.0


@pytest.mark.parametrize("height", np.linspace(1.8, 3.0, 25).tolist())
def test_ticks_have_the_room_that_they_need_whatever_the_height(height):
    sheet, (panel,) = grid(7.6, height)
    panel.add(Line(X, np.array([0.0, 5.0, 9.7])))
    panel.x.title, panel.y.title, panel.y.low = "error (µrad)", "rows (%)", 0.0
    (placed,) = layout(sheet).placed
    widest = max(scales.width_of(text, panel.y.size) for text in placed.y_ticks.values())
    assert placed.inner[0] >= widest + scales.height_of("rows (%)", 9.0)
    assert placed.inner[0] <= widest + scales.height_of("rows (%)", 9.0) + 20.0


def test_panels_that_share_limits_follow_each_other_and_stand_at_their_places():
    sheet = Sheet(6.0, 4.0, heights=(2.0, 1.0), share_x=True)
    above, below = sheet.panel(0), sheet.panel(1)
    above.add(Line(X, Y))
    below.add(Line(X + 5.0, Y))
    below.x.title = "time (s)"
    plot = turned(sheet)
    assert plot["layout"]["xaxis2"]["matches"] == "x"
    assert plot["layout"]["xaxis"]["range"] == plot["layout"]["xaxis2"]["range"]
    assert (plot["layout"]["xaxis"]["showticklabels"], plot["layout"]["xaxis2"]["showticklabels"]) == (False, True)
    assert plot["panels"][0]["titles"]["xaxis"] == "time (s)"  # for when it stands alone
    first, second = (each["inner"] for each in plot["panels"])
    assert first[3] < second[1]
    assert (first[3] - first[1]) / (second[3] - second[1]) == pytest.approx(2.0, rel=0.01)
    assert (first[0], first[2]) == (second[0], second[2])


def test_equal_scales_have_the_same_points_a_unit():
    sheet = one(Line(X, Y), x={"low": -180.0, "high": 180.0}, y={"low": -90.0, "high": 90.0})
    sheet.panels[0].equal = True
    wide, high = layout(sheet).placed[0].size
    assert wide / high == pytest.approx(2.0)
    assert turned(sheet)["ratio"] is True


def test_a_sheet_grows_for_panels_that_have_no_room():
    sheet, panels = grid(4.0, 0.5, 3, 1)
    for panel in panels:
        panel.add(Line(X, Y))
        panel.x.title, panel.title = "time (s)", "a title"
    found = layout(sheet)
    assert found.height > 0.5 * 72.0
    assert all(each.size[1] > 20.0 for each in found.placed)
    lowest = max(each.outer[3] for each in found.placed)
    assert found.height - 10.0 < lowest < found.height  # what stands below the last panel is on the sheet, and no more


# ------------------------------------------------------------------------------------------------ legends
def test_a_legend_switches_its_curves_and_those_that_look_like_them():
    sheet = one(
        Line(X, Y, BLUE, label="a"), Line(X, Y, VERMILION, "--", label="b"), Line(X, Y, BLUE, ":", name="a, linear")
    )
    sheet.legend = Legend("above", 2)
    (key,) = turned(sheet)["keys"]
    assert [(entry["label"], entry["data"]) for entry in key["entries"]] == [("a", [0, 2]), ("b", [1])]
    assert key["entries"][1]["line"]["dash"] == "dash"
    assert {"a", "b"} <= set(texts(sheet))


def test_legends_of_panels_switch_their_own_curves_only():
    sheet, (left, right) = grid(6.0, 3.0, 1, 2)
    for panel, title in ((left, "15 Hz"), (right, "25 Hz")):
        panel.add(Line(X, Y, BLUE, label="PID"))
        panel.title, panel.legend = title, Legend("above")
    keys = turned(sheet)["keys"]
    assert [(key["title"], key["entries"][0]["data"]) for key in keys] == [("15 Hz", [0]), ("25 Hz", [1])]


def test_a_small_marker_is_seen_in_the_legend():
    for marker, size in ((".", 7.0), ("o", 3.5)):
        sheet = one(Line(X, Y, BLUE, "", label="measured", marker=marker, size=1.0))
        sheet.legend = Legend("above")
        (key,) = layout(sheet).keys
        assert key.entries[0].size == size
        assert turned(sheet)["keys"][0]["entries"][0]["marker"]["size"] == pytest.approx(3.5 * 96.0 / 72.0, abs=0.01)
        assert only(turned(sheet))["marker"]["size"] < 1.5
    large = one(Line(X, Y, BLUE, "", label="measured", marker="o", size=8.0))
    large.legend = Legend("above")
    assert layout(large).keys[0].entries[0].size == 8.0


def test_a_legend_without_a_place_keeps_clear_of_the_curves():
    falling = one(Line(np.linspace(0.0, 1.0, 500), np.linspace(1.0, 0.0, 500), label="falls"))
    falling.panels[0].legend = Legend()
    (key,), (placed,) = layout(falling).keys, layout(falling).placed
    left, top, right, bottom = placed.inner
    middle = (left + right) / 2.0, (top + bottom) / 2.0
    assert (key.x > middle[0]) == (key.y < middle[1])


@pytest.mark.parametrize(
    ("under", "corner"),
    [
        ((), ("right", "top")),
        (("right top",), ("left", "top")),
        (("right top", "left top"), ("left", "bottom")),
        (("right top", "left top", "left bottom"), ("right", "bottom")),
        (("right top", "left top", "left bottom", "right bottom"), ("right", "top")),  # each as bad as the others
    ],
)
def test_a_legend_stands_in_the_first_corner_that_is_free(under, corner):
    ends = {"x": {"low": 0.0, "high": 1.0}, "y": {"low": 0.0, "high": 1.0}}
    at = [(0.97 if "right" in each else 0.03, 0.97 if "top" in each else 0.03) for each in under]
    empty_line = Line(np.empty(0), np.empty(0), label="a curve of the legend alone")
    sheet = one(*(Line(np.array([x]), np.array([y])) for x, y in at), empty_line, **ends)
    sheet.panels[0].legend = Legend()
    found = layout(sheet)
    (key,), (placed,) = found.keys, found.placed
    left, top, right, bottom = placed.inner
    assert (
        "left" if key.x < (left + right) / 3 else "right",
        "top" if key.y < (top + bottom) / 2 else "bottom",
    ) == corner


@pytest.mark.parametrize(
    ("place", "room"),
    [("above", (0, 1)), ("below", (0, -1)), ("right", (-1, 0)), ("upper right", (-1, 0)), ("lower right", (-1, 0))],
)
def test_the_legend_of_a_sheet_stands_at_its_edge_and_takes_room_there(place, room):
    sheet = one(Line(X, Y, label="a"), Line(X, Y, VERMILION, label="b"))
    (alone,) = layout(sheet).placed
    sheet.legend = Legend(place)
    found = layout(sheet)
    (key,), (placed,) = found.keys, found.placed
    moved = [b - a for a, b in zip(alone.inner, placed.inner, strict=True)]
    side = {(0, 1): 1, (0, -1): 3, (-1, 0): 2}[room]
    assert [round(abs(each), 6) > 0 for each in moved] == [k == side for k in range(4)]
    assert (moved[side] > 0) == (side == 1)
    outer = placed.outer
    if side == 2:
        assert key.x >= outer[2] and key.x + key.width == pytest.approx(found.width - 3.0)
        assert (key.y > found.height / 2) == (place == "lower right")
    elif side == 1:
        assert key.y + key.height <= outer[1]
    else:
        assert key.y >= outer[3]


def test_a_legend_has_its_entries_by_columns_and_none_without_labels():
    marks = [Line(X, Y, label=label) for label in ("a", "b", "long\nlabel", "a", "")]
    sheet = one(*marks)
    sheet.legend = Legend("above", 2, title="a title that is the widest of all of them in this legend")
    (key,) = layout(sheet).keys
    assert ([each.label for each in key.entries], key.rows, len(key.columns)) == (["a", "b", "long\nlabel"], 2, 2)
    assert key.width == pytest.approx(scales.width_of(sheet.legend.title, 8.0))
    assert key.height == pytest.approx(scales.LINE * 1.15 * 8.0 * 4)  # title, two lines, one
    for legend, labels in ((Legend(only=(marks[1],)), ["b"]), (None, None)):
        sheet.legend = legend
        found = layout(sheet).keys
        assert [[each.label for each in key.entries] for key in found] == ([labels] if labels else [])
    nameless = one(Line(X, Y))
    nameless.legend, nameless.panels[0].legend = Legend("above"), Legend()
    assert layout(nameless).keys == []


def test_what_is_not_labelled_has_no_texts_beside_it():
    sheet = one(Line(X, Y), x={"labelled": False, "title": "time (s)"}, y={"title": "rms (rad)"})
    (placed,) = layout(sheet).placed
    assert (placed.x_shown, placed.y_shown) == (False, True)
    assert turned(sheet)["layout"]["xaxis"]["showticklabels"] is False
    assert set(texts(sheet)) == {"time (s)", "rms (rad)", *placed.y_ticks.values()}
    other = one(Line(X, Y), y={"labelled": False})
    (placed,) = layout(other).placed
    assert (placed.x_shown, placed.y_shown) == (True, False)
    assert set(texts(other)) == set(placed.x_ticks.values())
    shown, hidden = layout(one(Line(X, Y))), layout(other)
    assert hidden.placed[0].inner[0] == 2 * 3.0 and shown.placed[0].inner[0] > 2 * 3.0


def test_room_is_kept_at_the_right_for_words_that_begin_at_the_end_alone():
    def right(**more):
        words_ = Words("a text that is long", **{"x": 1.0, "y": 4.0, "of_panel": "x", **more})
        (placed,) = layout(one(Line(X, Y), words_)).placed
        return placed.outer[2] - placed.inner[2]

    wide = scales.width_of("a text that is long", 8.0)
    assert right() == pytest.approx(wide + 3.0)
    assert right(shift=(5.0, 0.0)) == pytest.approx(wide + 8.0)
    assert max(right(anchor="end"), right(anchor="middle"), right(x=0.9), right(of_panel="")) < 20.0


def test_a_colour_bar_has_round_ticks_unless_they_are_set():
    cells = Field(X, Y, np.arange(9.0).reshape(3, 3), 0.0, 8.0, title="margin (dB)")
    (placed,) = layout(one(cells)).placed
    assert [*placed.bar_ticks.values()] == ["0", "2", "4", "6", "8"]
    (placed,) = layout(one(replace(cells, ticks=(0.0, 8.0)))).placed
    assert [*placed.bar_ticks.values()] == ["0", "8"]
    (placed,) = layout(one(replace(cells, title=""))).placed
    assert placed.bar is None and placed.bar_ticks == {}
    sheet = one(replace(cells, title="", spoken="rate (Hz)"))
    assert "rate: %{z:.5~g} Hz" in only(turned(sheet))["hovertemplate"]
    assert "showscale" in only(turned(sheet)) and turned(sheet)["scales"] == []
    sheet.panels[0].marks[0] = replace(cells, title="")
    sheet.panels[0].title = "at 15 Hz"
    assert "at 15 Hz: %{z:.5~g}<" in only(turned(sheet))["hovertemplate"]


def test_a_field_of_one_row_or_column_has_cells_of_one():
    cells = Field(np.array([2.0]), np.array([1.0, 3.0]), np.zeros((2, 1)), 0.0, 1.0)
    assert scales.edges_of(cells, "x").tolist() == [1.5, 2.5]
    assert scales.edges_of(cells, "y").tolist() == [0.0, 2.0, 4.0]
    assert len([each for each in parts(one(cells), "rect") if each.get("stroke-width") == "0.6"]) == 2
    leveled = replace(cells, levels=np.array([0.0, 1.0]))
    assert (scales.edges_of(leveled, "x").tolist(), scales.edges_of(leveled, "y").tolist()) == ([1.5, 2.5], [1.0, 3.0])


def test_rings_of_two_points_are_no_area():
    two, three = np.array([[0.0, 0.0], [1.0, 1.0]]), np.array([[0.0, 0.0], [1.0, 1.0], [1.0, 0.0]])
    for rings, count in (((two,), 0), ((), 0), ((two, three), 1)):
        for hatched in (False, True):
            sheet = one(Area(rings, SKY, hatched=hatched))
            plot = turned(sheet)
            assert len(plot["data"]) + len(plot["layout"]["shapes"]) == count
            assert sum(each.get("fill-rule") == "evenodd" for each in parts(sheet, "path")) == count


def test_words_that_stand_nowhere_are_not_drawn():
    sheet = one(Line(X + 1.0, Y), Words("lost", math.nan, 4.0), Words("there", 1.0, math.nan), Words("", 1.0, 4.0))
    assert not {"lost", "there"} & set(texts(sheet))
    assert not turned(sheet)["layout"]["annotations"]


def test_a_marked_curve_is_one_trace_unless_it_has_fewer_markers_than_points():
    def modes(**more):
        return [each["mode"] for each in turned(one(Line(X, Y, marker="o", **more)))["data"]]

    assert modes() == ["lines+markers"]
    assert modes(every=[0, 2]) == ["lines", "markers"]
    assert modes(dash="") == ["markers"]
    many = np.arange(5_000.0)
    traces = turned(one(Line(many, np.sin(many), marker="o")))["data"]
    assert [each["mode"] for each in traces] == ["lines", "markers"]
    assert len(traces[0]["x"]) < len(traces[1]["x"]) == 5_000
    assert traces[1]["hoverinfo"] == "skip" and "hoverinfo" not in traces[0]


@pytest.mark.parametrize(
    ("of_line", "symbol", "colour"),
    [
        ({"marker": "s"}, "square", BLUE),
        ({"marker": "s", "face": ""}, "square-open", BLUE),
        ({"marker": "s", "face": "", "edge": SKY}, "square-open", SKY),
        ({"marker": "s", "face": SKY}, "square", SKY),
        ({"marker": "x"}, "x-thin-open", BLUE),
    ],
)
def test_a_marker_without_a_colour_inside_is_open(of_line, symbol, colour):
    made = only(turned(one(Line(X, Y, BLUE, "", **of_line))))["marker"]
    assert (made["symbol"], made["color"]) == (symbol, colour)


def test_the_hover_of_bars_says_where_they_begin_and_end():
    bars = Bars(np.array([1.0, 2.0]), np.array([0.0, 1.0]), np.array([3.0, 4.0]), np.array([0.5, 0.5]), BLUE)
    axes = {"x": {"title": "margin (dB)"}, "y": {"title": "place (m)"}}
    lying = only(turned(one(bars, **axes)))
    assert lying["hovertext"] == ["place: 0.75 to 1.25 m<br>margin: 3 dB", "place: 1.75 to 2.25 m<br>margin: 1 to 4 dB"]
    assert (lying["orientation"], lying["x"], lying["base"], lying["marker"]["line"]["width"]) == (
        "h",
        [3, 3],
        [0, 1],
        0,
    )
    upright = only(turned(one(replace(bars, upright=True, edge=SKY), **axes)))
    assert upright["hovertext"][1] == "margin: 1.75 to 2.25 dB<br>place: 1 to 4 m"
    assert (upright["orientation"], upright["marker"]["line"]) == ("v", {"width": 0.5, "color": SKY})


@pytest.mark.parametrize(
    ("title", "said"),
    [
        ("time (s)", "time: %{x:.5~g} s"),
        ("angle (°)", "angle: %{x:.5~g}°"),
        ("count", "count: %{x:.5~g}"),
        ("", "x: %{x:.5~g}"),
        ("two\nlines (Hz)", "two lines: %{x:.5~g} Hz"),
    ],
)
def test_a_value_is_spoken_with_the_name_and_unit_of_its_axis(title, said):
    assert spoken(title, "x") == said


def test_ticks_of_a_logarithmic_axis_that_are_set_are_texts_and_an_empty_list_is_none():
    def axis(**more):
        return turned(one(Line(X + 1.0, Y), x={"log": True, **more}))["layout"]["xaxis"]

    assert (axis(ticks=[1.0, 2.5])["ticktext"], axis(ticks=[1.0, 2.5])["tickvals"]) == (["1", "2.5"], [1, 2.5])
    linear = turned(one(Line(X, Y), x={"ticks": []}))["layout"]["xaxis"]
    assert (linear["showticklabels"], linear["ticks"]) == (False, "")
    assert "ticktext" not in turned(one(Line(X, Y), x={"ticks": [1.0]}))["layout"]["xaxis"]


# ------------------------------------------------------------------------------------------------ points and numbers
def test_a_curve_of_as_many_points_as_there_may_be_keeps_them_all():
    x = np.arange(9.0)
    assert thinned(x, np.sin(x), 9).tolist() == list(range(9))
    assert thinned(x, np.sin(x), 8).size <= 8
    assert (thinned(x[:0], x[:0]).size, thinned(x[:1], x[:1]).tolist()) == (0, [0])


@pytest.mark.parametrize("size", [0, 1, 2])
def test_on_a_logarithmic_axis_two_points_are_both_kept(size):
    x = np.array([1.0, 10.0])[:size]
    assert thinned_by_logarithm(x, x).tolist() == list(range(size))
    many = np.geomspace(1.0, 100.0, 1000)
    wave = np.where(np.arange(1000) == 500, 5.0, 0.0)
    kept = thinned_by_logarithm(many, wave, 4).tolist()
    assert {0, 500, 999} <= set(kept) and len(kept) <= 10


@pytest.mark.parametrize(
    ("name", "shown"),
    [("x" * 34, "x" * 34), ("x" * 35, "x" * 33 + "…"), ("two\nlines\x07 here", "two lines here"), ("", "")],
)
def test_a_name_in_a_figure_has_at_most_34_characters_on_one_line(name, shown):
    assert shortened(name) == shown


def test_an_area_is_parted_where_either_curve_is_not_known():
    gap = np.array([0.0, math.nan, 0.0, 0.0])
    x, high = np.arange(4.0), np.array([1.0, 1.0, 1.0, math.inf])
    assert [ring.tolist() for ring in between(x, gap, high, SKY, 1.0).rings] == [
        [[0.0, 0.0], [0.0, 1.0]],
        [[2.0, 0.0], [2.0, 1.0]],
    ]
    assert between(x[:0], x[:0], x[:0], SKY, 1.0).rings == ()
    assert between(x, gap * math.nan, high, SKY, 1.0).rings == ()


@pytest.mark.promise("report-11")
def test_decimation_keeps_ends_peaks_and_gaps():
    x = np.arange(100_000.0)
    y = np.sin(x / 1e3)
    y[777], y[50_000:50_010] = 9.0, math.nan
    kept = thinned(x, y)
    assert kept.size <= MOST_POINTS
    assert {0, 777, 99_999} <= set(kept.tolist())
    assert np.isnan(y[kept]).any()
    assert len(only(turned(one(Line(x, y))))["x"]) == kept.size


def test_a_curve_over_time_has_as_many_swings_as_there_are_points_for():
    time = np.arange(20_000.0)
    high, low = thinned(time, np.sin(time)), thinned(np.sin(time / 3e3), np.sin(time))
    assert MOST_POINTS * 0.95 < high.size <= MOST_POINTS
    swings = [np.abs(np.diff(np.sin(time)[kept])) > 1.9 for kept in (high, low)]
    assert swings[0].sum() > 550  # of 599 stretches
    assert swings[1].sum() < 450  # where x says something too


def test_a_closed_curve_keeps_the_extremes_of_both_coordinates():
    at = np.linspace(0.0, 2.0 * math.pi, 50_001)
    kept = thinned(np.cos(at), np.sin(at))
    for values in (np.cos(at), np.sin(at)):
        assert (values[kept].min(), values[kept].max()) == (values.min(), values.max())


def test_numbers_have_five_digits_and_more_where_they_differ_by_little():
    assert numbers([1.0 / 3.0, 2.0, math.inf]) == [0.33333, 2, None]
    close = numbers([1e6 + 0.001, 1e6 + 0.002])
    assert close[0] != close[1]


# ------------------------------------------------------------------------------------------------ in a page
def test_hostile_names_are_words_and_end_nothing():
    sheet = one(Line(X, Y, label=HOSTILE), x={"title": f"{HOSTILE} (s)"}, y={"ticks": {3.0: HOSTILE, 4.0: "b"}})
    sheet.panels[0].title, sheet.panels[0].legend, sheet.heading = HOSTILE, Legend(), HOSTILE
    plot = plot_of(sheet)
    text = text_of(plot)
    assert not re.search("[<>&]", text)
    assert json.loads(text)["data"] == plot["data"]
    for shown in (
        plot["data"][0]["name"],
        plot["layout"]["xaxis"]["title"]["text"],
        plot["layout"]["yaxis"]["ticktext"][0],
    ):
        assert shown.startswith("&lt;/script&gt;&lt;b onclick")
        assert "%{" not in shown
    assert plot["data"][0]["hovertemplate"].count("%{") == 3  # words at the tick, x, and the name
    assert plot["keys"][0]["entries"][0]["label"] == HOSTILE  # becomes a text node
    assert words("a\nb") == "a<br>b"
    assert texts(sheet).count(HOSTILE) == 4  # heading, title, tick and legend: as text
    assert "<b " not in svg_of(sheet)


def page_of(*drawn, files=False):
    env = templates()
    source = (
        '{% from "page/figure.html" import drawn %}<!DOCTYPE html><html><body>{{ drawn(figures, files) }}</body></html>'
    )
    return scripts.with_scripts(env.from_string(source).render(figures=drawn, files=files))


def a_figure(name="one", title="T", columns=None):
    return Figure(name, title, "C", one(Line(X, Y)), columns or {})


def test_two_pictures_of_a_page_share_no_id_and_keep_what_theirs_refer_to():
    ring = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 0.0]])
    sheet = one(Area((ring,), BLACK, hatched=True), Line(X, Y, label='<g id="a" href="#b">'))
    sheet.panels[0].legend = Legend()
    first, second = (Figure(name, "T", "C", sheet, {}) for name in ("one", "two (a/b)"))
    assert_sound(page_of(first, second))
    for picture, prefix in ((first.labelled, "one-"), (second.labelled, "two--a-b--")):
        ids = [each.get("id") for each in ET.fromstring(picture).iter() if each.get("id")]
        assert ids == [f"{prefix}1"]
        assert picture.count("url(#") == 1
        assert '&lt;g id="a" href="#b"&gt;' in picture  # a text is no tag
        assert "<style" not in picture  # it would hold for the whole page


@pytest.mark.parametrize(("low", "high"), [(0.0, None), (0.0, 100.0), (-1.0, None), (None, 0.0)])
def test_a_logarithmic_axis_takes_no_end_that_is_not_positive(low, high):
    sheet, (panel,) = grid(4.0, 3.0)
    panel.y = Axis("time (s)", log=True, low=low, high=high)
    panel.add(Line(np.array([0.0, 1.0]), np.array([2.0, 50.0])))
    ends = scales.limits(panel.y, "y", [panel])
    assert 1.0 < ends[0] < 2.0
    assert ends[1] == 100.0 if high else 50.0 < ends[1] < 100.0
    assert "<path" in svg_of(sheet)
    assert plot_of(sheet)["layout"]["yaxis"]["range"] == pytest.approx(np.log10(ends), abs=1e-4)


def test_columns_become_rows_of_text_with_gaps_left_empty():
    columns = {"input": ("a", "b", "c"), "value (m)": np.array([1.0 / 3.0, math.nan]), "n": np.array([1e9])}
    assert rows_of(columns, 3) == [("a", "0.333", "1e+09"), ("b", "", ""), ("c", "", "")]


def test_numbers_stand_below_a_picture_where_they_are_wanted():
    figure = a_figure(columns={"input <b>": ("x&y",), "value (m)": np.array([0.25])})
    assert figure.static.plot == ""
    assert figure.static.svg == figure.svg
    source = '{% from "page/figure.html" import drawn %}{{ drawn(figures, false, true) }}'
    page = templates().from_string(source).render(figures=[figure.static])
    assert "<script" not in page
    assert '<th>input &lt;b&gt;</th><th class="number">value (m)</th>' in page
    assert '<td>x&amp;y</td><td class="number">0.25</td>' in page
    assert "<details" not in page_of(figure)


@pytest.mark.promise("report-11", "report-12")
def test_a_page_carries_the_library_once_and_only_for_interactive_figures():
    figure = a_figure(title='Title "A" <b>')
    page = page_of(figure, figure, files=True)
    assert page.count(scripts.library()) == 1
    assert page.index("<figcaption") < page.index(scripts.library()) < page.index("</body>")
    assert page.count(scripts.MARK) == page.count('<svg role="img" aria-label="Title &quot;A&quot; &lt;b&gt;"') == 2
    assert '<a href="figures/one.csv">' in page
    static = Figure("two", "Words", "Caption", empty("nothing to see"), {})
    assert static.plot == ""
    assert scripts.library() not in page_of(static)
    assert page_of(static).count("<script") == page_of(figure).count(scripts.keyboard()) == 1
    assert 'role="img"' in page_of(static)


@pytest.mark.promise("licences-1", "report-11")
def test_the_library_is_whole_licensed_and_ends_no_element():
    found = re.findall(r"<script>(.*?)</script>", scripts.library(), re.DOTALL)
    assert len(found) == 2
    assert "plotly.js (cartesian - minified) v4" in found[0]
    assert "Licensed under the MIT license" in found[0]
    assert len(scripts.library().encode()) < 1.6e6
    folder = scripts.resources.files("microrad.report.page")
    assert "MIT License" in folder.joinpath("vendor/plotly-LICENSE.txt").read_text(encoding="utf-8")


def test_figure_text_is_the_same_each_time():
    assert a_figure().plot == a_figure().plot != ""
    assert a_figure().svg == a_figure().svg


@pytest.fixture(scope="module")
def drawn():
    """Every figure of the shipped mission but those of the fine-pointing loop, which takes the longest."""
    return plain_drawn().every


def test_every_figure_of_the_study_is_interactive_and_small(drawn):
    assert [figure.name for figure in drawn if not figure.plot] == []
    assert max(len(figure.plot) for figure in drawn) < 300_000
    for figure in drawn:
        plot = json.loads(figure.plot)
        assert all(len(trace["x"]) <= MOST_POINTS + 50 for trace in plot["data"] if trace["type"] == "scatter"), (
            figure.name
        )
        axes = [axis for key, axis in plot["layout"].items() if re.match("[xy]axis", key)]
        assert all(panel["inner"][0] < panel["inner"][2] <= plot["size"][0] for panel in plot["panels"]), figure.name
        assert len(axes) == 2 * len(plot["panels"])


def test_nothing_of_a_picture_leaves_it(drawn):
    for figure in drawn:
        found = layout(figure.sheet)
        for each in found.placed:
            assert min(each.outer[0], each.outer[1]) >= -0.5, figure.name
            assert each.outer[2] <= found.width + 0.5, figure.name
            assert each.outer[3] <= found.height + 0.5, figure.name
        assert all(key.x >= 0.0 and key.x + key.width <= found.width for key in found.keys), figure.name


def test_axes_with_numbers_carry_units(drawn):
    for figure in drawn:
        plot = json.loads(figure.plot)
        for panel in plot["panels"]:
            for key, title in panel["titles"].items():
                if "ticktext" not in plot["layout"][key]:
                    assert re.search(r"\([^()]+\)|hours since|volume by relay over volume direct", title), (
                        figure.name,
                        title,
                    )


def test_pictures_of_words_alone_are_the_static_ones():
    nothing = Figure("latency", "T", "C", empty("nothing was delivered"), {})
    for figure, said in (
        (nothing, "nothing was delivered"),
        (assumptions([], 1.0, "ratio"), "no assumption was varied"),
    ):
        assert figure.plot == ""
        assert said in figure.svg
    assert assumptions([Assumed("a", 1.0, 2.0)], 1.5, "ratio (1)").plot != ""


# ------------------------------------------------------------------------------------- sheets with all of it together
def every_kind():
    """Two panels above each other with every kind of mark, unlike each other in each field."""
    sheet = Sheet(
        6.0, 5.0, (1.0, 2.0), share_x=True, legend=Legend("below", 2), heading="Head & <b>", heading_colour=GREY
    )
    above, below = sheet.panel(0), sheet.panel(1)
    above.title, above.face, above.framed = "First", "#eeeeee", True
    above.y = Axis("gain (dB)", low=-2.0, high=6.0, ticks=(-2.0, 0.0, 6.0), size=7.0)
    below.x, below.y = Axis("time (s)", low=1.0, high=100.0, log=True), Axis("two\nlines (µrad)", low=0.0, high=9.0)
    x = np.array([1.0, 4.0, 10.0, 40.0])
    arms = np.array([[0.5, 1.0, 2.0, 0.0], [1.0, 2.0, 4.0, 0.0]])
    above.add(
        Span(2.0, 8.0, True, SKY, 0.4, "a span"),
        Line(x, np.array([0.0, np.nan, 3.0, 5.0]), BLUE, (3.0, 1.0), 1.7, "dashes", marker="D", size=5.0, every=(0, 3)),
        Line(x, x / 10.0, VERMILION, "", label="arms", marker="s", face="", edge=BLACK, edge_width=0.7, x_arms=arms),
        Rule(2.5, False, GREY, "-.", 0.9, "a rule"),
        Words("here\nand there", 20.0, 1.0, VERMILION, 7.0, "end", "top", (3.0, -4.0), box=True),
    )
    below.add(
        Area((np.array([[1.0, 1.0], [5.0, 1.0], [5.0, 4.0]]),), SKY, 0.6, "an area", BLACK, 0.8),
        Area((np.array([[20.0, 2.0], [60.0, 2.0], [60.0, 7.0]]),), GREY, label="hatched", hatched=True),
        Bars(
            np.array([10.0, 30.0]),
            np.array([0.0, 1.0]),
            np.array([2.0, 8.0]),
            np.array([4.0, 9.0]),
            BLUE,
            True,
            0.7,
            BLACK,
            "bars",
        ),
        Line(x, np.array([1.0, 2.0, 8.0, 4.0]), GREY, ":", 2.0, name="unlabelled", steps=True, clip=False),
        Line(x, 9.0 - x / 5.0, BLACK, "--", 1.1, marker="x", size=8.0, y_arms=arms / 4.0),
        Words("at a share", 0.25, 0.75, anchor="middle", base="bottom", of_panel="xy"),
    )
    below.legend = Legend("upper left", title="Key", size=7.0, only=(Line(X, Y, BLUE, label="own", marker="."),))
    return sheet


def fields_of_both_kinds():
    """A map of cells with words at its axes and one of levels, each with a bar, beside each other."""
    sheet = Sheet(8.0, 3.0, widths=(2.0, 1.0))
    cells, levels = sheet.panel(0, 0), sheet.panel(0, 1)
    z = np.array([[1.0, 2.0, np.nan], [4.0, 8.0, 16.0]])
    cells.add(Field(X, np.array([0.0, 1.0]), z, 1.0, 16.0, "cells (dB)", ticks=(1.0, 4.0, 16.0)))
    cells.x, cells.y = Axis("case", ticks={0.0: "one", 1.0: "2 m", 2.0: "three"}), Axis("row", ticks={0: "a", 1: "b"})
    cells.title = "Cells"
    plane = np.add.outer(np.array([0.0, 1.0, 2.0]), np.array([0.0, 2.0]))
    levels.add(Field(np.array([5.0, 7.0]), X, plane, 0.0, 4.0, levels=np.array([1.0, 2.0, 3.0]), spoken="level (m)"))
    levels.equal = True
    return sheet


def json_lines(plot):
    return textwrap.wrap(json.dumps(plot, ensure_ascii=False), 100, break_long_words=False, break_on_hyphens=False)


def test_a_picture_of_every_kind_of_mark_is_the_same_to_a_hundredth_of_a_point():
    assert svg_of(every_kind()).split("\n") == [
        (
            '<svg xmlns="http://www.w3.org/2000/svg" width="576" height="480" viewBox="0 0 432 '
            '360" font-family="system-ui, \'DejaVu Sans\', sans-serif" fill="#1b1f24" '
            'stroke-linejoin="round">'
        ),
        (
            '<defs><pattern id="hatch" width="5" height="5" patternUnits="userSpaceOnUse" '
            'patternTransform="rotate(45)"><path d="M0 0V5" stroke="#000000" '
            'stroke-width="1.2"/></pattern></defs>'
        ),
        ('<text x="429.00" y="11.55" font-size="9" text-anchor="end" fill="#777777">Head &amp; &lt;b&gt;</text>'),
        '<rect x="39.86" y="30.60" width="380.50" height="78.91" fill="#eeeeee"/>',
        (
            '<path d="M54.25 30.60V109.51M112.38 30.60V109.51M170.52 30.60V109.51M228.66 '
            '30.60V109.51M286.79 30.60V109.51M344.93 30.60V109.51M403.06 30.60V109.51" '
            'stroke="#dddddd" stroke-width="0.6" fill="none"/>'
        ),
        (
            '<path d="M39.86 109.51H420.36M39.86 89.78H420.36M39.86 30.60H420.36" '
            'stroke="#dddddd" stroke-width="0.6" fill="none"/>'
        ),
        ('<svg x="39.86" y="30.60" width="380.50" height="78.91"><g transform="translate(-39.86 -30.60)">'),
        '<rect x="65.88" y="30.60" width="34.88" height="78.91" fill="#56B4E9" fill-opacity="0.4"/>',
        (
            '<path d="M60.06 89.78M112.38 60.19L286.79 40.46" fill="none" stroke="#0072B2" '
            'stroke-width="1.7" stroke-dasharray="5.1 1.7"/>'
        ),
        (
            '<path d="M57.56 89.78l2.5 2.5l2.5 -2.5l-2.5 -2.5ZM284.29 40.46l2.5 2.5l2.5 '
            '-2.5l-2.5 -2.5Z" fill="#0072B2" stroke="#0072B2" stroke-width="1"/>'
        ),
        (
            '<path d="M57.16 88.80L65.88 88.80M57.16 85.80l0 6M65.88 85.80l0 6M71.69 '
            "85.84L89.13 85.84M71.69 82.84l0 6M89.13 82.84l0 6M100.76 79.92L135.64 "
            '79.92M100.76 76.92l0 6M135.64 76.92l0 6" fill="none" stroke="#D55E00" '
            'stroke-width="1"/>'
        ),
        (
            '<path d="M57.06 85.80h6v6h-6ZM74.50 82.84h6v6h-6ZM109.38 76.92h6v6h-6ZM283.79 '
            '47.33h6v6h-6Z" fill="none" stroke="#000000" stroke-width="0.7"/>'
        ),
        (
            '<path d="M39.86 65.12H420.36" fill="none" stroke="#777777" stroke-width="0.9" '
            'stroke-dasharray="5.76 1.44 0.9 1.44"/>'
        ),
        "</g></svg>",
        (
            '<path d="M39.86 30.60V109.51H420.36V30.60ZM54.25 109.51v3.5M112.38 '
            "109.51v3.5M170.52 109.51v3.5M228.66 109.51v3.5M286.79 109.51v3.5M344.93 "
            '109.51v3.5M403.06 109.51v3.5M39.86 109.51h-3.5M39.86 89.78h-3.5M39.86 30.60h-3.5" '
            'stroke="#1b1f24" stroke-width="0.8" fill="none"/>'
        ),
        '<text x="33.36" y="111.96" font-size="7" text-anchor="end">−2</text>',
        '<text x="33.36" y="92.23" font-size="7" text-anchor="end">0</text>',
        '<text x="33.36" y="33.05" font-size="7" text-anchor="end">6</text>',
        (
            '<text x="15.86" y="73.21" font-size="9" text-anchor="middle" '
            'transform="rotate(-90 15.86 70.06)">gain (dB)</text>'
        ),
        '<text x="39.86" y="25.35" font-size="9">First</text>',
        ('<rect x="139.50" y="83.92" width="34.02" height="16.80" fill="#ffffff" fill-opacity="0.75"/>'),
        (
            '<text x="173.52" y="90.57" font-size="7" text-anchor="end" fill="#D55E00"><tspan '
            'x="173.52" y="90.57">here</tspan><tspan x="173.52" y="98.97">and '
            "there</tspan></text>"
        ),
        (
            '<path d="M39.86 117.91V275.74M230.11 117.91V275.74M420.36 117.91V275.74" '
            'stroke="#dddddd" stroke-width="0.6" fill="none"/>'
        ),
        (
            '<path d="M39.86 275.74H420.36M39.86 240.67H420.36M39.86 205.59H420.36M39.86 '
            '170.52H420.36M39.86 135.45H420.36" stroke="#dddddd" stroke-width="0.6" '
            'fill="none"/>'
        ),
        ('<svg x="39.86" y="117.91" width="380.50" height="157.83"><g transform="translate(-39.86 -117.91)">'),
        (
            '<path d="M39.86 258.2L172.84 258.2L172.84 205.59Z" fill="#56B4E9" '
            'fill-opacity="0.6" fill-rule="evenodd" stroke="#000000" stroke-width="0.8"/>'
        ),
        (
            '<path d="M287.38 240.67L378.15 240.67L378.15 152.99Z" fill="url(#hatch)" '
            'fill-opacity="1" fill-rule="evenodd"/>'
        ),
        (
            '<path d="M211.67 275.74H245.17V240.67H211.67ZM307.45 '
            '258.20H332.43V135.45H307.45Z" fill="#0072B2" fill-opacity="0.7" stroke="#000000" '
            'stroke-width="0.5"/>'
        ),
        (
            '<path d="M39.86 121.42L154.4 131.94L230.11 152.99L344.65 258.2" fill="none" '
            'stroke="#000000" stroke-width="1.1" stroke-dasharray="4.07 1.76"/>'
        ),
        (
            '<path d="M39.86 123.61L39.86 117.04M36.86 123.61l6 0M36.86 117.04l6 0M154.40 '
            "136.33L154.40 123.17M151.40 136.33l6 0M151.40 123.17l6 0M230.11 161.75L230.11 "
            '135.45M227.11 161.75l6 0M227.11 135.45l6 0" fill="none" stroke="#000000" '
            'stroke-width="1"/>'
        ),
        (
            '<path d="M35.86 117.42l8 8m0 -8l-8 8M150.40 127.94l8 8m0 -8l-8 8M226.11 148.99l8 '
            '8m0 -8l-8 8M340.65 254.20l8 8m0 -8l-8 8" fill="none" stroke="#000000" '
            'stroke-width="1"/>'
        ),
        "</g></svg>",
        (
            '<path d="M39.86 117.91V275.74H420.36M39.86 275.74v3.5M230.11 275.74v3.5M420.36 '
            "275.74v3.5M39.86 275.74h-3.5M39.86 240.67h-3.5M39.86 205.59h-3.5M39.86 "
            "170.52h-3.5M39.86 135.45h-3.5M39.86 275.74v2M97.13 275.74v2M130.63 "
            "275.74v2M154.40 275.74v2M172.84 275.74v2M187.90 275.74v2M200.64 275.74v2M211.67 "
            "275.74v2M221.40 275.74v2M230.11 275.74v2M287.38 275.74v2M320.88 275.74v2M344.65 "
            "275.74v2M363.09 275.74v2M378.15 275.74v2M390.89 275.74v2M401.92 275.74v2M411.65 "
            '275.74v2M420.36 275.74v2" stroke="#1b1f24" stroke-width="0.8" fill="none"/>'
        ),
        '<text x="39.86" y="290.79" font-size="9" text-anchor="middle">1</text>',
        '<text x="230.11" y="290.79" font-size="9" text-anchor="middle">10</text>',
        '<text x="420.36" y="290.79" font-size="9" text-anchor="middle">100</text>',
        '<text x="33.36" y="278.89" font-size="9" text-anchor="end">0</text>',
        '<text x="33.36" y="243.82" font-size="9" text-anchor="end">2</text>',
        '<text x="33.36" y="208.74" font-size="9" text-anchor="end">4</text>',
        '<text x="33.36" y="173.67" font-size="9" text-anchor="end">6</text>',
        '<text x="33.36" y="138.60" font-size="9" text-anchor="end">8</text>',
        '<text x="230.11" y="304.59" font-size="9" text-anchor="middle">time (s)</text>',
        (
            '<text x="13.80" y="194.58" font-size="9" text-anchor="middle" '
            'transform="rotate(-90 13.80 196.83)"><tspan x="13.80" '
            'y="194.58">two</tspan><tspan x="13.80" y="205.38">lines (µrad)</tspan></text>'
        ),
        (
            '<path d="M39.86 258.2L154.4 258.2L154.4 240.67L230.11 240.67L230.11 135.45L344.65 '
            '135.45L344.65 205.59" fill="none" stroke="#777777" stroke-width="2" '
            'stroke-dasharray="2 3.3"/>'
        ),
        '<text x="134.99" y="155.37" font-size="8" text-anchor="middle">at a share</text>',
        '<text x="45.86" y="127.56" font-size="7">Key</text>',
        '<path d="M45.86 135.40h20" fill="none" stroke="#0072B2" stroke-width="1.3"/>',
        (
            '<path d="M54.11 135.40a1.75 1.75 0 1 0 3.5 0a1.75 1.75 0 1 0 -3.5 0Z" '
            'fill="#0072B2" stroke="#0072B2" stroke-width="0"/>'
        ),
        '<text x="70.86" y="137.85" font-size="7">own</text>',
        ('<rect x="153.64" y="315.16" width="20.00" height="6.40" fill="#56B4E9" fill-opacity="0.4"/>'),
        '<text x="178.64" y="321.16" font-size="8">a span</text>',
        ('<path d="M153.64 329.40h20" fill="none" stroke="#0072B2" stroke-width="1.7" stroke-dasharray="5.1 1.7"/>'),
        ('<path d="M161.14 329.40l2.5 2.5l2.5 -2.5l-2.5 -2.5Z" fill="#0072B2" stroke="#0072B2" stroke-width="1"/>'),
        '<text x="178.64" y="332.20" font-size="8">dashes</text>',
        '<path d="M160.64 337.44h6v6h-6Z" fill="none" stroke="#000000" stroke-width="0.7"/>',
        '<text x="178.64" y="343.24" font-size="8">arms</text>',
        (
            '<path d="M153.64 351.48h20" fill="none" stroke="#777777" stroke-width="0.9" '
            'stroke-dasharray="5.76 1.44 0.9 1.44"/>'
        ),
        '<text x="178.64" y="354.28" font-size="8">a rule</text>',
        (
            '<rect x="220.88" y="315.16" width="20.00" height="6.40" fill="#56B4E9" '
            'fill-opacity="0.6" stroke="#000000" stroke-width="0.5"/>'
        ),
        '<text x="245.88" y="321.16" font-size="8">an area</text>',
        '<rect x="220.88" y="326.20" width="20.00" height="6.40" fill="#777777" fill-opacity="1"/>',
        '<text x="245.88" y="332.20" font-size="8">hatched</text>',
        (
            '<rect x="220.88" y="337.24" width="20.00" height="6.40" fill="#0072B2" '
            'fill-opacity="0.7" stroke="#000000" stroke-width="0.5"/>'
        ),
        '<text x="245.88" y="343.24" font-size="8">bars</text>',
        "</svg>",
        "",
    ]


def test_the_interactive_form_of_every_kind_of_mark_has_each_of_its_fields():
    assert json_lines(plot_of(every_kind())) == [
        ('{"size": [576.0, 480.0], "keys": [{"title": "Key", "entries": [{"label": "own", "line": {"color":'),
        ('"#0072B2", "width": 1.73, "dash": "solid"}, "marker": {"symbol": "circle", "size": 4.67, "color":'),
        ('"#0072B2"}, "data": [], "shapes": []}]}, {"title": "", "entries": [{"label": "a span", "area":'),
        ('"rgba(86,180,233,0.4)", "data": [], "shapes": [0]}, {"label": "dashes", "line": {"color": "#0072B2",'),
        ('"width": 2.27, "dash": "6.8px,2.27px"}, "marker": {"symbol": "diamond", "size": 6.67, "color":'),
        ('"#0072B2", "line": {"color": "#0072B2", "width": 1.33}}, "data": [0, 1], "shapes": []}, {"label":'),
        ('"arms", "marker": {"symbol": "square-open", "size": 8.0, "color": "#000000", "line": {"color":'),
        ('"#000000", "width": 0.93}}, "data": [2], "shapes": []}, {"label": "a rule", "line": {"color":'),
        ('"#777777", "width": 1.2, "dash": "dashdot"}, "data": [], "shapes": [1]}, {"label": "an area",'),
        ('"area": "rgba(86,180,233,0.6)", "data": [], "shapes": [3]}, {"label": "hatched", "area": "#777777",'),
        ('"data": [3], "shapes": []}, {"label": "bars", "area": "rgba(0,114,178,0.7)", "data": [4], "shapes":'),
        ('[]}]}], "data": [{"xaxis": "x", "yaxis": "y", "name": "dashes", "type": "scatter", "mode": "lines",'),
        ('"x": [1, 4, 10, 40], "y": [0, null, 3, 5], "hovertemplate": "time: %{x:.5~g} s<br>gain: %{y:.5~g}'),
        'dB<extra>%{fullData.name}</extra>", "line": {"color": "#0072B2", "width": 2.27, "dash":',
        ('"6.8px,2.27px", "shape": "linear", "simplify": false}}, {"xaxis": "x", "yaxis": "y", "name":'),
        ('"dashes", "type": "scatter", "mode": "markers", "x": [1, 40], "y": [0, 5], "hovertemplate": null,'),
        ('"marker": {"symbol": "diamond", "size": 6.67, "color": "#0072B2", "line": {"color": "#0072B2",'),
        ('"width": 1.33}}, "hoverinfo": "skip"}, {"xaxis": "x", "yaxis": "y", "name": "arms", "type":'),
        ('"scatter", "mode": "markers", "x": [1, 4, 10, 40], "y": [0.1, 0.4, 1, 4], "hovertemplate": "time:'),
        '%{x:.5~g} s<br>gain: %{y:.5~g} dB<extra>%{fullData.name}</extra>", "marker": {"symbol":',
        ('"square-open", "size": 8.0, "color": "#000000", "line": {"color": "#000000", "width": 0.93}},'),
        ('"error_x": {"type": "data", "symmetric": false, "arrayminus": [0.5, 1, 2, 0], "array": [1, 2, 4, 0],'),
        '"color": "#D55E00", "thickness": 1.3, "width": 4}}, {"xaxis": "x2", "yaxis": "y2", "name":',
        ('"hatched", "type": "scatter", "mode": "lines", "x": [20, 60, 60], "y": [2, 2, 7], "fill": "toself",'),
        ('"fillpattern": {"shape": "/", "size": 6, "solidity": 0.15, "fgcolor": "#000000", "bgcolor":'),
        ('"rgba(0,0,0,0)"}, "line": {"width": 0, "color": "#000000"}, "hoverinfo": "skip"}, {"xaxis": "x2",'),
        ('"yaxis": "y2", "name": "bars", "type": "bar", "orientation": "v", "y": [2, 7], "x": [10, 30],'),
        ('"width": [4, 9], "base": [0, 1], "marker": {"color": "rgba(0,114,178,0.7)", "line": {"width": 0.5,'),
        ('"color": "#000000"}}, "hovertext": ["time: 8 to 12 s<br>two lines: 2 µrad", "time: 25.5 to 34.5'),
        ('s<br>two lines: 1 to 8 µrad"], "hovertemplate": "%{hovertext}<extra>%{fullData.name}</extra>"},'),
        ('{"xaxis": "x2", "yaxis": "y2", "name": "unlabelled", "type": "scatter", "mode": "lines", "x": [1, 4,'),
        '10, 40], "y": [1, 2, 8, 4], "hovertemplate": "time: %{x:.5~g} s<br>two lines: %{y:.5~g}',
        ('µrad<extra>%{fullData.name}</extra>", "line": {"color": "#777777", "width": 2.67, "dash": "dot",'),
        ('"shape": "hv", "simplify": false}, "cliponaxis": false}, {"xaxis": "x2", "yaxis": "y2", "name": "",'),
        '"type": "scatter", "mode": "lines+markers", "x": [1, 4, 10, 40], "y": [8.8, 8.2, 7, 1],',
        ('"hovertemplate": "time: %{x:.5~g} s<br>two lines: %{y:.5~g} µrad<extra>%{fullData.name}</extra>",'),
        ('"line": {"color": "#000000", "width": 1.47, "dash": "dash", "shape": "linear", "simplify": false},'),
        ('"marker": {"symbol": "x-thin-open", "size": 10.67, "color": "#000000", "line": {"color": "#000000",'),
        ('"width": 1.33}}, "error_y": {"type": "data", "symmetric": false, "arrayminus": [0.125, 0.25, 0.5,'),
        ('0], "array": [0.25, 0.5, 1, 0], "color": "#000000", "thickness": 1.3, "width": 4}}], "layout":'),
        '{"font": {"size": 12, "color": "#1b1f24", "family": "system-ui, DejaVu Sans, sans-serif"},',
        ('"hoverlabel": {"align": "left", "namelength": -1}, "paper_bgcolor": "rgba(0,0,0,0)", "plot_bgcolor":'),
        ('"rgba(0,0,0,0)", "margin": {"l": 0, "r": 0, "t": 0, "b": 0}, "showlegend": false, "hovermode":'),
        ('"closest", "dragmode": "zoom", "barmode": "overlay", "xaxis": {"type": "linear", "range": [-2.475,'),
        '62.975], "anchor": "y", "showticklabels": false, "ticks": "outside", "ticklen": 4,',
        ('"ticklabeloverflow": "allow", "gridcolor": "#dddddd", "linecolor": "#1b1f24", "showgrid": true,'),
        '"mirror": true, "showline": true, "zeroline": false, "title": {"text": "", "standoff": 5},',
        ('"tickfont": {"size": 12.0}, "exponentformat": "power", "minexponent": 5}, "yaxis": {"type":'),
        ('"linear", "range": [-2, 6], "anchor": "x", "showticklabels": true, "ticks": "outside", "ticklen": 4,'),
        ('"ticklabeloverflow": "allow", "gridcolor": "#dddddd", "linecolor": "#1b1f24", "showgrid": true,'),
        ('"mirror": true, "showline": true, "zeroline": false, "title": {"text": "gain (dB)", "standoff": 5},'),
        ('"tickfont": {"size": 9.33}, "exponentformat": "power", "minexponent": 5}, "xaxis2": {"type": "log",'),
        '"range": [0, 2], "anchor": "y2", "showticklabels": true, "ticks": "outside", "ticklen": 4,',
        ('"ticklabeloverflow": "allow", "gridcolor": "#dddddd", "linecolor": "#1b1f24", "showgrid": true,'),
        ('"mirror": false, "showline": true, "zeroline": false, "title": {"text": "time (s)", "standoff": 5},'),
        ('"tickfont": {"size": 12.0}, "nticks": 5, "tickformat": "~g", "matches": "x"}, "yaxis2": {"type":'),
        ('"linear", "range": [0, 9], "anchor": "x2", "showticklabels": true, "ticks": "outside", "ticklen": 4,'),
        ('"ticklabeloverflow": "allow", "gridcolor": "#dddddd", "linecolor": "#1b1f24", "showgrid": true,'),
        ('"mirror": false, "showline": true, "zeroline": false, "title": {"text": "two<br>lines (µrad)",'),
        ('"standoff": 5}, "tickfont": {"size": 12.0}, "exponentformat": "power", "minexponent": 5}, "shapes":'),
        ('[{"type": "rect", "layer": "below", "x0": 2, "x1": 8, "xref": "x", "y0": 0, "y1": 1, "yref": "y'),
        ('domain", "fillcolor": "rgba(86,180,233,0.4)", "line": {"width": 0}}, {"type": "line", "layer":'),
        ('"above", "x0": 0, "x1": 1, "xref": "x domain", "y0": 2.5, "y1": 2.5, "yref": "y", "line": {"color":'),
        ('"#777777", "width": 1.2, "dash": "dashdot"}}, {"type": "rect", "x0": 0, "x1": 1, "y0": 0, "y1": 1,'),
        ('"layer": "below", "line": {"width": 0}, "xref": "x domain", "yref": "y domain", "fillcolor":'),
        ('"#eeeeee"}, {"type": "path", "path": "M1,1L5,1L5,4Z", "fillrule": "evenodd", "xref": "x2", "yref":'),
        ('"y2", "layer": "between", "fillcolor": "rgba(86,180,233,0.6)", "line": {"color": "#000000", "width":'),
        ('1.07}}], "annotations": [{"text": "here<br>and there", "showarrow": false, "borderpad": 0, "font":'),
        ('{"size": 9.33, "color": "#D55E00"}, "x": 20, "xref": "x", "xshift": 4.0, "y": 1, "yref": "y",'),
        ('"yshift": -5.33, "xanchor": "right", "yanchor": "top", "bgcolor": "rgba(255,255,255,0.75)"},'),
        ('{"text": "First", "xref": "x domain", "yref": "y domain", "x": 0, "y": 1, "yshift": 3, "xanchor":'),
        ('"left", "yanchor": "bottom", "showarrow": false, "font": {"size": 12}}, {"text": "at a share",'),
        ('"showarrow": false, "borderpad": 0, "font": {"size": 10.67, "color": "#000000"}, "x": 0.25, "xref":'),
        ('"x2 domain", "xshift": 0.0, "y": 0.75, "yref": "y2 domain", "yshift": 0.0, "xanchor": "center",'),
        ('"yanchor": "bottom"}]}, "panels": [{"x": "xaxis", "y": "yaxis", "inner": [53.1, 40.8, 560.5, 146.0],'),
        ('"outer": [13.9, 22.4, 568.5, 150.0], "titles": {"xaxis": "time (s)", "yaxis": "gain (dB)"}}, {"x":'),
        ('"xaxis2", "y": "yaxis2", "inner": [53.1, 157.2, 560.5, 367.7], "outer": [4.0, 150.0, 572.0, 409.1],'),
        ('"titles": {"xaxis2": "time (s)", "yaxis2": "two<br>lines (µrad)"}}], "scales": [], "heading":'),
        '[{"text": "Head & <b>", "color": "#777777"}], "ratio": false}',
    ]


def test_pictures_of_fields_have_each_cell_level_bar_and_word():
    assert svg_of(fields_of_both_kinds()).split("\n") == [
        (
            '<svg xmlns="http://www.w3.org/2000/svg" width="768" height="288" viewBox="0 0 576 '
            '216" font-family="system-ui, \'DejaVu Sans\', sans-serif" fill="#1b1f24" '
            'stroke-linejoin="round">'
        ),
        (
            '<path d="M80.34 16.80V181.90M183.07 16.80V181.90M285.81 16.80V181.90" '
            'stroke="#dddddd" stroke-width="0.6" fill="none"/>'
        ),
        ('<path d="M28.97 140.62H337.18M28.97 58.08H337.18" stroke="#dddddd" stroke-width="0.6" fill="none"/>'),
        ('<svg x="28.97" y="16.80" width="308.21" height="165.10"><g transform="translate(-28.97 -16.80)">'),
        (
            '<rect x="28.97" y="99.35" width="102.74" height="82.55" fill="#00224e" '
            'stroke="#00224e" stroke-width="0.6"/>'
        ),
        (
            '<rect x="131.71" y="99.35" width="102.74" height="82.55" fill="#022f6a" '
            'stroke="#022f6a" stroke-width="0.6"/>'
        ),
        (
            '<rect x="28.97" y="16.80" width="102.74" height="82.55" fill="#35456d" '
            'stroke="#35456d" stroke-width="0.6"/>'
        ),
        (
            '<rect x="131.71" y="16.80" width="102.74" height="82.55" fill="#767675" '
            'stroke="#767675" stroke-width="0.6"/>'
        ),
        (
            '<rect x="234.44" y="16.80" width="102.74" height="82.55" fill="#fee838" '
            'stroke="#fee838" stroke-width="0.6"/>'
        ),
        "</g></svg>",
        (
            '<path d="M28.97 16.80V181.90H337.18M80.34 181.90v3.5M183.07 181.90v3.5M285.81 '
            '181.90v3.5M28.97 140.62h-3.5M28.97 58.08h-3.5" stroke="#1b1f24" '
            'stroke-width="0.8" fill="none"/>'
        ),
        '<text x="80.34" y="196.95" font-size="9" text-anchor="middle">one</text>',
        '<text x="183.07" y="196.95" font-size="9" text-anchor="middle">2 m</text>',
        '<text x="285.81" y="196.95" font-size="9" text-anchor="middle">three</text>',
        '<text x="22.47" y="143.78" font-size="9" text-anchor="end">a</text>',
        '<text x="22.47" y="61.23" font-size="9" text-anchor="end">b</text>',
        '<text x="183.07" y="210.75" font-size="9" text-anchor="middle">case</text>',
        ('<text x="8.40" y="102.50" font-size="9" text-anchor="middle" transform="rotate(-90 8.40 99.35)">row</text>'),
        '<text x="28.97" y="11.55" font-size="9">Cells</text>',
        '<rect x="346.18" y="179.32" width="11.00" height="2.88" fill="#002452"/>',
        '<rect x="346.18" y="176.74" width="11.00" height="2.88" fill="#002658"/>',
        '<rect x="346.18" y="174.16" width="11.00" height="2.88" fill="#002a60"/>',
        '<rect x="346.18" y="171.58" width="11.00" height="2.88" fill="#002c66"/>',
        '<rect x="346.18" y="169.00" width="11.00" height="2.88" fill="#032f6b"/>',
        '<rect x="346.18" y="166.42" width="11.00" height="2.88" fill="#0a326c"/>',
        '<rect x="346.18" y="163.84" width="11.00" height="2.88" fill="#10346d"/>',
        '<rect x="346.18" y="161.26" width="11.00" height="2.88" fill="#17376e"/>',
        '<rect x="346.18" y="158.68" width="11.00" height="2.88" fill="#1d396f"/>',
        '<rect x="346.18" y="156.10" width="11.00" height="2.88" fill="#233c6e"/>',
        '<rect x="346.18" y="153.52" width="11.00" height="2.88" fill="#293f6e"/>',
        '<rect x="346.18" y="150.94" width="11.00" height="2.88" fill="#2f426d"/>',
        '<rect x="346.18" y="148.36" width="11.00" height="2.88" fill="#34446d"/>',
        '<rect x="346.18" y="145.78" width="11.00" height="2.88" fill="#38476d"/>',
        '<rect x="346.18" y="143.20" width="11.00" height="2.88" fill="#3d4a6c"/>',
        '<rect x="346.18" y="140.62" width="11.00" height="2.88" fill="#414d6c"/>',
        '<rect x="346.18" y="138.05" width="11.00" height="2.88" fill="#45506c"/>',
        '<rect x="346.18" y="135.47" width="11.00" height="2.88" fill="#49526c"/>',
        '<rect x="346.18" y="132.89" width="11.00" height="2.88" fill="#4d566d"/>',
        '<rect x="346.18" y="130.31" width="11.00" height="2.88" fill="#51586d"/>',
        '<rect x="346.18" y="127.73" width="11.00" height="2.88" fill="#555b6d"/>',
        '<rect x="346.18" y="125.15" width="11.00" height="2.88" fill="#585e6e"/>',
        '<rect x="346.18" y="122.57" width="11.00" height="2.88" fill="#5c616e"/>',
        '<rect x="346.18" y="119.99" width="11.00" height="2.88" fill="#5f646f"/>',
        '<rect x="346.18" y="117.41" width="11.00" height="2.88" fill="#636670"/>',
        '<rect x="346.18" y="114.83" width="11.00" height="2.88" fill="#666970"/>',
        '<rect x="346.18" y="112.25" width="11.00" height="2.88" fill="#6a6c72"/>',
        '<rect x="346.18" y="109.67" width="11.00" height="2.88" fill="#6d6f72"/>',
        '<rect x="346.18" y="107.09" width="11.00" height="2.88" fill="#717274"/>',
        '<rect x="346.18" y="104.51" width="11.00" height="2.88" fill="#747475"/>',
        '<rect x="346.18" y="101.93" width="11.00" height="2.88" fill="#787876"/>',
        '<rect x="346.18" y="99.35" width="11.00" height="2.88" fill="#7b7a77"/>',
        '<rect x="346.18" y="96.77" width="11.00" height="2.88" fill="#7f7e78"/>',
        '<rect x="346.18" y="94.19" width="11.00" height="2.88" fill="#838078"/>',
        '<rect x="346.18" y="91.61" width="11.00" height="2.88" fill="#868478"/>',
        '<rect x="346.18" y="89.03" width="11.00" height="2.88" fill="#8a8678"/>',
        '<rect x="346.18" y="86.45" width="11.00" height="2.88" fill="#8e8a78"/>',
        '<rect x="346.18" y="83.87" width="11.00" height="2.88" fill="#928c77"/>',
        '<rect x="346.18" y="81.29" width="11.00" height="2.88" fill="#959077"/>',
        '<rect x="346.18" y="78.71" width="11.00" height="2.88" fill="#999276"/>',
        '<rect x="346.18" y="76.13" width="11.00" height="2.88" fill="#9d9676"/>',
        '<rect x="346.18" y="73.55" width="11.00" height="2.88" fill="#a19874"/>',
        '<rect x="346.18" y="70.97" width="11.00" height="2.88" fill="#a59c74"/>',
        '<rect x="346.18" y="68.39" width="11.00" height="2.88" fill="#a99e72"/>',
        '<rect x="346.18" y="65.81" width="11.00" height="2.88" fill="#ada271"/>',
        '<rect x="346.18" y="63.23" width="11.00" height="2.88" fill="#b1a570"/>',
        '<rect x="346.18" y="60.65" width="11.00" height="2.88" fill="#b6a96e"/>',
        '<rect x="346.18" y="58.08" width="11.00" height="2.88" fill="#baac6d"/>',
        '<rect x="346.18" y="55.50" width="11.00" height="2.88" fill="#beb06b"/>',
        '<rect x="346.18" y="52.92" width="11.00" height="2.88" fill="#c2b369"/>',
        '<rect x="346.18" y="50.34" width="11.00" height="2.88" fill="#c7b666"/>',
        '<rect x="346.18" y="47.76" width="11.00" height="2.88" fill="#cbb964"/>',
        '<rect x="346.18" y="45.18" width="11.00" height="2.88" fill="#cfbd62"/>',
        '<rect x="346.18" y="42.60" width="11.00" height="2.88" fill="#d3c05f"/>',
        '<rect x="346.18" y="40.02" width="11.00" height="2.88" fill="#d8c45c"/>',
        '<rect x="346.18" y="37.44" width="11.00" height="2.88" fill="#dcc759"/>',
        '<rect x="346.18" y="34.86" width="11.00" height="2.88" fill="#e0cb56"/>',
        '<rect x="346.18" y="32.28" width="11.00" height="2.88" fill="#e5cf51"/>',
        '<rect x="346.18" y="29.70" width="11.00" height="2.88" fill="#e9d24d"/>',
        '<rect x="346.18" y="27.12" width="11.00" height="2.88" fill="#eed648"/>',
        '<rect x="346.18" y="24.54" width="11.00" height="2.88" fill="#f2da44"/>',
        '<rect x="346.18" y="21.96" width="11.00" height="2.88" fill="#f5de41"/>',
        '<rect x="346.18" y="19.38" width="11.00" height="2.88" fill="#f9e23d"/>',
        '<rect x="346.18" y="16.80" width="11.00" height="2.88" fill="#fce63a"/>',
        '<path d="M357.18 181.90h3.5" stroke="#1b1f24" stroke-width="0.8"/>',
        '<text x="363.68" y="185.05" font-size="9">1</text>',
        '<path d="M357.18 148.88h3.5" stroke="#1b1f24" stroke-width="0.8"/>',
        '<text x="363.68" y="152.03" font-size="9">4</text>',
        '<path d="M357.18 16.80h3.5" stroke="#1b1f24" stroke-width="0.8"/>',
        '<text x="363.68" y="19.95" font-size="9">16</text>',
        (
            '<text x="383.60" y="102.50" font-size="9" text-anchor="middle" '
            'transform="rotate(-90 383.60 99.35)">cells (dB)</text>'
        ),
        (
            '<path d="M412.90 22.30V176.40M489.95 22.30V176.40M567.00 22.30V176.40" '
            'stroke="#dddddd" stroke-width="0.6" fill="none"/>'
        ),
        (
            '<path d="M412.90 176.40H567.00M412.90 137.88H567.00M412.90 99.35H567.00M412.90 '
            '60.82H567.00M412.90 22.30H567.00" stroke="#dddddd" stroke-width="0.6" '
            'fill="none"/>'
        ),
        ('<svg x="412.90" y="22.30" width="154.10" height="154.10"><g transform="translate(-412.90 -22.30)">'),
        (
            '<path d="M412.9 176.4L489.95 176.4L412.9 99.35L412.9 99.35L412.9 99.35L412.9 '
            '176.4Z" fill="#1a386f" fill-rule="evenodd" stroke="#1a386f" stroke-width="0.4"/>'
        ),
        (
            '<path d="M489.95 176.4L567 176.4L567 176.4L489.95 99.35L412.9 22.3L412.9 '
            '22.3L412.9 99.35L412.9 99.35L489.95 176.4Z" fill="#61656f" fill-rule="evenodd" '
            'stroke="#61656f" stroke-width="0.4"/>'
        ),
        (
            '<path d="M489.95 99.35L567 176.4L567 99.35L567 99.35L489.95 22.3L412.9 '
            '22.3L489.95 99.35Z" fill="#9b9476" fill-rule="evenodd" stroke="#9b9476" '
            'stroke-width="0.4"/>'
        ),
        (
            '<path d="M489.95 22.3L567 99.35L567 22.3L489.95 22.3Z" fill="#dec958" '
            'fill-rule="evenodd" stroke="#dec958" stroke-width="0.4"/>'
        ),
        "</g></svg>",
        (
            '<path d="M412.90 22.30V176.40H567.00M412.90 176.40v3.5M489.95 176.40v3.5M567.00 '
            "176.40v3.5M412.90 176.40h-3.5M412.90 137.88h-3.5M412.90 99.35h-3.5M412.90 "
            '60.82h-3.5M412.90 22.30h-3.5" stroke="#1b1f24" stroke-width="0.8" fill="none"/>'
        ),
        '<text x="412.90" y="191.45" font-size="9" text-anchor="middle">5</text>',
        '<text x="489.95" y="191.45" font-size="9" text-anchor="middle">6</text>',
        '<text x="567.00" y="191.45" font-size="9" text-anchor="middle">7</text>',
        '<text x="406.40" y="179.55" font-size="9" text-anchor="end">0</text>',
        '<text x="406.40" y="141.03" font-size="9" text-anchor="end">0.5</text>',
        '<text x="406.40" y="102.50" font-size="9" text-anchor="end">1.0</text>',
        '<text x="406.40" y="63.97" font-size="9" text-anchor="end">1.5</text>',
        '<text x="406.40" y="25.45" font-size="9" text-anchor="end">2.0</text>',
        "</svg>",
        "",
    ]


def test_the_interactive_form_of_fields_has_each_cell_level_bar_and_word():
    assert json_lines(plot_of(fields_of_both_kinds())) == [
        ('{"size": [768.0, 288.0], "keys": [], "data": [{"xaxis": "x", "yaxis": "y", "name": "", "type":'),
        ('"heatmap", "z": [[1, 2, null], [4, 8, 16]], "x": [0, 1, 2], "y": [0, 1], "colorscale": [[0.0,'),
        ('"#00224e"], [0.0625, "#002e6a"], [0.125, "#1a386f"], [0.1875, "#32436d"], [0.25, "#434e6c"],'),
        ('[0.3125, "#535a6d"], [0.375, "#61656f"], [0.4375, "#6f7073"], [0.5, "#7d7c78"], [0.5625, "#8c8878"],'),
        ('[0.625, "#9b9476"], [0.6875, "#aba072"], [0.75, "#bcae6c"], [0.8125, "#cdbb63"], [0.875, "#dec958"],'),
        ('[0.9375, "#f0d846"], [1.0, "#fee838"]], "zauto": false, "showscale": true, "zmin": 1, "zmax": 16,'),
        '"hovertemplate": "%{text}<br>cells: %{z:.5~g} dB<extra>%{fullData.name}</extra>", "text":',
        ('[["a<br>one", "a<br>case: 2 m", "a<br>three"], ["b<br>one", "b<br>case: 2 m", "b<br>three"]],'),
        '"colorbar": {"title": {"text": "cells (dB)", "side": "right"}, "tickvals": [1, 4, 16],',
        ('"outlinewidth": 0}}, {"xaxis": "x2", "yaxis": "y2", "name": "", "type": "contour", "z": [[0, 2], [1,'),
        ('3], [2, 4]], "x": [5, 7], "y": [0, 1, 2], "colorscale": [[0.0, "#00224e"], [0.0625, "#002e6a"],'),
        ('[0.125, "#1a386f"], [0.1875, "#32436d"], [0.25, "#434e6c"], [0.3125, "#535a6d"], [0.375, "#61656f"],'),
        ('[0.4375, "#6f7073"], [0.5, "#7d7c78"], [0.5625, "#8c8878"], [0.625, "#9b9476"], [0.6875, "#aba072"],'),
        ('[0.75, "#bcae6c"], [0.8125, "#cdbb63"], [0.875, "#dec958"], [0.9375, "#f0d846"], [1.0, "#fee838"]],'),
        ('"zauto": false, "showscale": false, "zmin": 0, "zmax": 4, "hovertemplate": "x: %{x:.5~g}<br>y:'),
        ('%{y:.5~g}<br>level: %{z:.5~g} m<extra>%{fullData.name}</extra>", "line": {"width": 0}, "contours":'),
        ('{"start": 1.0, "end": 3.0, "size": 1.0, "coloring": "fill"}}], "layout": {"font": {"size": 12,'),
        ('"color": "#1b1f24", "family": "system-ui, DejaVu Sans, sans-serif"}, "hoverlabel": {"align": "left",'),
        ('"namelength": -1}, "paper_bgcolor": "rgba(0,0,0,0)", "plot_bgcolor": "rgba(0,0,0,0)", "margin":'),
        ('{"l": 0, "r": 0, "t": 0, "b": 0}, "showlegend": false, "hovermode": "closest", "dragmode": "zoom",'),
        '"barmode": "overlay", "xaxis": {"type": "linear", "range": [-0.5, 2.5], "anchor": "y",',
        ('"showticklabels": true, "ticks": "outside", "ticklen": 4, "ticklabeloverflow": "allow", "gridcolor":'),
        ('"#dddddd", "linecolor": "#1b1f24", "showgrid": true, "mirror": false, "showline": true, "zeroline":'),
        ('false, "title": {"text": "case", "standoff": 5}, "tickfont": {"size": 12.0}, "tickmode": "array",'),
        ('"tickvals": [0, 1, 2], "ticktext": ["one", "2 m", "three"]}, "yaxis": {"type": "linear", "range":'),
        '[-0.5, 1.5], "anchor": "x", "showticklabels": true, "ticks": "outside", "ticklen": 4,',
        ('"ticklabeloverflow": "allow", "gridcolor": "#dddddd", "linecolor": "#1b1f24", "showgrid": true,'),
        ('"mirror": false, "showline": true, "zeroline": false, "title": {"text": "row", "standoff": 5},'),
        ('"tickfont": {"size": 12.0}, "tickmode": "array", "tickvals": [0, 1], "ticktext": ["a", "b"]},'),
        ('"xaxis2": {"type": "linear", "range": [5, 7], "anchor": "y2", "showticklabels": true, "ticks":'),
        ('"outside", "ticklen": 4, "ticklabeloverflow": "allow", "gridcolor": "#dddddd", "linecolor":'),
        ('"#1b1f24", "showgrid": true, "mirror": false, "showline": true, "zeroline": false, "title": {"text":'),
        ('"", "standoff": 5}, "tickfont": {"size": 12.0}, "exponentformat": "power", "minexponent": 5},'),
        ('"yaxis2": {"type": "linear", "range": [0, 2], "anchor": "x2", "showticklabels": true, "ticks":'),
        ('"outside", "ticklen": 4, "ticklabeloverflow": "allow", "gridcolor": "#dddddd", "linecolor":'),
        ('"#1b1f24", "showgrid": true, "mirror": false, "showline": true, "zeroline": false, "title": {"text":'),
        ('"", "standoff": 5}, "tickfont": {"size": 12.0}, "exponentformat": "power", "minexponent": 5,'),
        ('"scaleanchor": "x2", "scaleratio": 1.0}, "shapes": [], "annotations": [{"text": "Cells", "xref": "x'),
        ('domain", "yref": "y domain", "x": 0, "y": 1, "yshift": 3, "xanchor": "left", "yanchor": "bottom",'),
        ('"showarrow": false, "font": {"size": 12}}]}, "panels": [{"x": "xaxis", "y": "yaxis", "inner": [38.6,'),
        ('22.4, 449.6, 242.5], "outer": [4.0, 4.0, 468.2, 284.0], "titles": {"xaxis": "case", "yaxis":'),
        ('"row"}}, {"x": "xaxis2", "y": "yaxis2", "inner": [550.5, 29.7, 756.0, 235.2], "outer": [522.7, 15.2,'),
        ('764.0, 258.3], "titles": {"xaxis2": "", "yaxis2": ""}}], "scales": [{"trace": 0, "panel": 0,'),
        ('"inner": [461.6, 22.4, 476.2, 242.5], "outer": [461.6, 22.4, 522.7, 242.5]}], "heading": [],'),
        '"ratio": true}',
    ]


@pytest.mark.parametrize("place", ["above", "below", "right", "upper right", "lower right"])
def test_the_legend_of_a_sheet_keeps_apart_from_its_heading(place):
    sheet = one(Line(X, Y, BLUE, label="curve"), Line(X, Y, SKY, label="other one"))
    sheet.legend, sheet.heading = Legend(place, 2 if place in ("above", "below") else 1), "heading"
    (key,), (placed,) = layout(sheet).keys, layout(sheet).placed
    assert key.x >= 0.0 and key.x + key.width <= 6.4 * 72.0 and key.y + key.height <= 4.0 * 72.0
    left, top, right, bottom = placed.inner
    assert key.y + key.height < top or key.y > bottom or key.x > right
    assert key.y > 10.0 and left < right


@pytest.mark.parametrize(
    ("title", "value", "said"),
    [("case (m)", 0.9, "case: 2 near m"), ("case", 2.0, "three"), ("", 0.0, "one"), ("case (m)", -5.0, "one")],
)
def test_a_value_beside_words_has_those_nearest_to_it(title, value, said):
    axis = Axis(title, ticks={0.0: "one", 1.0: "2\nnear", 2.0: "three"})
    assert interactive._word(axis, title, value) == said


# ------------------------------------------------------------------------------------------------ numbers unlike others
def test_each_letter_has_its_own_width():
    every = "".join(map(chr, range(32, 127)))
    assert scales.width_of(every, 8.0) == pytest.approx(454.0)
    assert sum(k * scales.width_of(each, 100.0) for k, each in enumerate(every, 1)) == pytest.approx(272910.0)


@pytest.mark.parametrize(
    ("low", "high", "most", "found"),
    [
        (3.0, 9.0, 3, "3 5 7"),
        (3.0, 9.0, 2, "5 7.5"),  # no tick of a decade is left: round numbers
        (2.0, 60.0, 5, "2 5 10 20 50"),
        (0.02, 0.06, 3, "0.02 0.03 0.05"),
        (1e3, 1e8, 3, "1e+04 1e+06 1e+08"),
        (1.5, 35.0, 4, "2 5 10 20"),
        (0.7, 140.0, 4, "1 10 100"),
        (2.0, 5.0, 2, "2 5"),
        (12.0, 18.0, 3, "12.5 15 17.5"),
        (7e-4, 6e-3, 4, "0.001 0.002 0.005"),
    ],
)
def test_ticks_of_an_axis_of_few_decades_are_the_finest_that_there_is_room_for(low, high, most, found):
    assert [f"{each:.4g}" for each in scales.decades(low, high, most)] == found.split()


@pytest.mark.parametrize(
    ("low", "high", "most", "found"),
    [
        (-7.3, -1.1, 6, "−7 −6 −5 −4 −3 −2"),
        (622.08, 1244.16, 5, "800 1000 1200"),
        (0.0, 7e-9, 4, "0 2×10⁻⁹ 4×10⁻⁹ 6×10⁻⁹"),
        (0.1, 0.9, 3, "0.25 0.50 0.75"),
        (1e7, 4e7, 5, "10⁷ 2×10⁷ 3×10⁷ 4×10⁷"),
        (-1e6, 3e6, 5, "−1000000 0 1000000 2000000 3000000"),
    ],
)
def test_round_ticks_as_they_are_written(low, high, most, found):
    assert scales.texts(scales.rounds(low, high, most)) == found.split()


@pytest.mark.parametrize(
    ("log", "which", "ends", "length", "found"),
    [
        (False, "x", (0.0, 1000.0), 130.0, "0 500 1000"),  # of a fourth there is no room between the texts
        (False, "x", (0.0, 1e6), 200.0, "0 250000 500000 750000 1000000"),
        (False, "x", (0.0, 1.0), 90.0, "0 1"),
        (False, "x", (36000.001, 36000.009), 300.0, "36000.002 36000.004 36000.006 36000.008"),
        (False, "x", (-5000.0, 5000.0), 150.0, "−5000 0 5000"),
        (False, "x", (5000.0, -5000.0), 150.0, "−5000 0 5000"),
        (False, "x", (1e-4, 9e-4), 160.0, "2.5×10⁻⁴ 5×10⁻⁴ 7.5×10⁻⁴"),  # one tick less is enough
        (False, "x", (36000.01, 36000.09), 180.0, "36000.025 36000.050 36000.075"),
        (False, "y", (5000.0, -5000.0), 70.0, "−5000 0 5000"),
        (True, "x", (1.0, 1e5), 100.0, "1 1000"),
        (True, "y", (1e-6, 1e2), 100.0, "10⁻⁶ 10⁻³ 10⁰"),
    ],
)
def test_ticks_are_as_many_as_their_texts_have_room_for(log, which, ends, length, found):
    at = scales.ticks(Axis(log=log), which, ends, length)
    assert [*at.values()] == found.split()
    assert [*at] == sorted(at)


RING = np.array([[1.0, 20.0], [3.0, 25.0], [2.0, 31.0]])
TWO_BARS = Bars(*map(np.array, ([1.0, 4.0], [2.0, -3.0], [7.0, 5.0], [0.5, 1.0])), BLUE)
CELLS = Field(np.array([1.0, 3.0, 5.0]), np.array([10.0, 14.0]), np.zeros((2, 3)), 0.0, 1.0)


@pytest.mark.parametrize(
    ("mark", "log", "x_ends", "y_ends"),
    [
        (Rule(-3.0, True), False, (-4.5, -1.5), (0.0, 1.0)),
        (Rule(-3.0, False), False, (0.0, 1.0), (-4.5, -1.5)),
        (Span(2.0, 6.5, True, SKY), False, (1.775, 6.725), (0.0, 1.0)),
        (Span(2.0, 6.5, False, SKY), False, (0.0, 1.0), (1.775, 6.725)),
        (Span(2.0, math.inf, False, SKY), False, (0.0, 1.0), (1.0, 3.0)),
        (Area((RING, RING - 1.0), BLUE), False, (-0.15, 3.15), (18.4, 31.6)),
        (TWO_BARS, False, (-3.5, 7.5), (0.5625, 4.6875)),
        (replace(TWO_BARS, upright=True), False, (0.5625, 4.6875), (-3.5, 7.5)),
        (CELLS, False, (0.0, 6.0), (8.0, 16.0)),
        (Rule(4.0, True), True, (4.0 / 3.0 * 9.0**-0.05, 12.0 * 9.0**0.05), (1.0, 10.0)),
        (Line(np.array([2.0]), np.array([-2.0])), False, (1.0, 3.0), (-3.0, -1.0)),
        (Line(np.array([2.0, 3.0]), np.array([0.1, 10.0])), True, (2 / 1.5**0.05, 3 * 1.5**0.05), (0.0794328, 12.5893)),
    ],
)
def test_the_limits_of_each_kind_of_mark_are_those_of_its_own_axis(mark, log, x_ends, y_ends):
    found = [scales.limits(Axis(log=log), which, [Panel(0, 0, marks=[mark])]) for which in "xy"]
    empty = [(1.0 * 10.0**-0.05, 10.0**1.05) if log else (-0.05, 1.05), (1.0, 10.0) if log else (0.0, 1.0)]
    wanted = [empty[0] if ends == empty[1] else ends for ends in (x_ends, y_ends)]
    assert found == [pytest.approx(ends, rel=1e-5, abs=1e-9) for ends in wanted]


def test_the_limits_of_arms_on_a_logarithmic_axis_and_of_one_end_that_is_set():
    line = Line(np.array([1.0, 1e3]), np.array([2.0, 3.0]), x_arms=np.array([[0.5, 2e3], [1.0, 3.0]]))
    panels = [Panel(0, 0, marks=[line])]
    wide = 1003.0 / 0.5
    assert scales.limits(Axis(log=True), "x", panels) == pytest.approx((0.5 * wide**-0.05, 1003.0 * wide**0.05))
    assert scales.limits(Axis(log=True, low=-1.0, high=1e4), "x", panels) == pytest.approx((0.5 * wide**-0.05, 1e4))
    assert scales.limits(Axis(low=-9.0), "x", panels) == pytest.approx((-9.0, 1003.0 + 0.05 * 2003.0))


@pytest.mark.parametrize(
    ("log", "ends", "values", "found"),
    [
        (False, (2.0, 10.0), "2 4 10 12", "0 0.25 1 1.25"),
        (False, (10.0, 2.0), "2 4 10", "1 0.75 0"),
        (True, (1.0, 1e4), "1 100 1e4 0.1", "0 0.5 1 -0.25"),
        (True, (1e4, 1.0), "10 1e4", "0.75 0"),
        (True, (1.0, 10.0), "0 -5", "-300 -300"),
    ],
)
def test_a_place_on_an_axis_goes_from_its_first_end_to_its_last(log, ends, values, found):
    at = scales.place(Axis(log=log), np.array(values.split(), dtype=float), ends)
    np.testing.assert_allclose(at, np.array(found.split(), dtype=float), atol=1e-12)


def test_ticks_between_stand_on_a_turned_axis_too():
    assert scales.minor(Axis(log=True), (30.0, 2.0)) == [2, 3, 4, 5, 6, 7, 8, 9, 10, 20, 30]


@pytest.mark.parametrize(
    ("share", "colour"),
    [(-1.0, "#00224e"), (0.03, "#00285b"), (0.5, "#7d7c78"), (0.77, "#c1b269"), (1.0, "#fee838"), (2.0, "#fee838")],
)
def test_a_colour_between_two_of_the_table_is_mixed_of_them(share, colour):
    assert colour_at(share) == colour


def test_points_of_a_long_curve_are_kept_by_stretch_in_each_way():
    x, y = np.geomspace(1.0, 1e3, 20), np.sin(1.3 * np.arange(20.0))
    assert thinned_by_logarithm(x, y, 4).tolist() == [0, 1, 4, 6, 8, 11, 13, 16, 18, 19]
    assert thinned(x, y, 8).tolist() == [0, 1, 4, 6, 8, 16, 18, 19]
    broken = np.insert(x, 10, math.nan), np.append(y, 0.0)
    assert thinned(*broken, 9).tolist() == [0, 4, 6, 9, 10, 11, 18, 20]


def boxes_of(found):
    """Boxes of the panels and places of the legends, to a hundredth of a point."""
    boxes = [[*each.inner, *each.outer, *(each.bar or ())] for each in found.placed]
    return [[round(n, 2) for n in box] for box in [*boxes, *([k.x, k.y, k.width, k.height] for k in found.keys)]]


def two_rows(place, sheets_place=None, **more):
    """A panel over two columns above two of unlike titles, one with a colour bar, with a legend in one of them."""
    sheet = Sheet(6.0, 5.0, (2.0, 1.0), (3.0, 1.0), **more)
    wide, left, right = sheet.panel(0, 0, 2), sheet.panel(1, 0), sheet.panel(1, 1)
    wide.add(Line(X, Y, BLUE, label="one"), Line(X, Y, VERMILION, label="another\none"))
    left.add(Line(X, 1e3 * Y, label="three"))
    right.add(Field(X, Y, np.arange(9.0).reshape(3, 3), -3.0, 8.0, title="margin (dB)"))
    wide.title, wide.title_size, wide.y.title, left.x.title = "a title", 12.0, "rms (rad)", "time (s)"
    wide.legend = Legend(place, 2, title="by kind")
    sheet.legend = Legend(sheets_place) if sheets_place else None
    return sheet


@pytest.mark.parametrize(
    ("place", "sheets_place", "more", "found"),
    [
        (
            "above",
            None,
            {},
            """
            37.7 56.52 374.18 220.97 3 3 381.38 238.27
            37.7 243.67 275.47 325.9 8.16 238.27 282.67 357
            294.93 243.67 374.18 325.9 282.67 238.27 429 343.2 383.18 243.67 394.18 325.9
            150.9 3 110.08 33.12
            """,
        ),
        (
            "below",
            None,
            {},
            """
            37.7 20.4 374.18 184.85 3 3 381.38 238.27
            37.7 243.67 275.47 325.9 8.16 238.27 282.67 357
            294.93 243.67 374.18 325.9 282.67 238.27 429 343.2 383.18 243.67 394.18 325.9
            150.9 205.15 110.08 33.12
            """,
        ),
        (
            "upper left",
            "below",
            {},
            """
            37.7 20.4 374.18 175.49 3 3 381.38 192.79
            37.7 198.19 275.47 275.74 8.16 192.79 282.67 306.84
            294.93 198.19 374.18 275.74 282.67 192.79 429 293.04 383.18 198.19 394.18 275.74
            43.7 23.4 110.08 33.12
            187.9 312.84 56.2 44.16
            """,
        ),
        (
            "lower left",
            "right",
            {},
            """
            37.7 20.4 308.98 208.93 3 3 316.18 226.23
            37.7 231.63 227.47 325.9 8.16 226.23 233.47 357
            245.73 231.63 308.98 325.9 233.47 226.23 363.8 343.2 317.98 231.63 328.98 325.9
            43.7 172.81 110.08 33.12
            372.8 9 56.2 44.16
            """,
        ),
        (
            "lower right",
            "lower right",
            {"heading": "a heading\nof two"},
            """
            37.7 45 308.98 217.13 3 27.6 316.18 234.43
            37.7 239.83 227.47 325.9 8.16 234.43 233.47 357
            245.73 239.83 308.98 325.9 233.47 234.43 363.8 343.2 317.98 239.83 328.98 325.9
            192.9 181.01 110.08 33.12
            372.8 312.84 56.2 44.16
            """,
        ),
        (
            "upper right",
            "above",
            {"heading": "a heading", "share_x": True, "share_y": True},
            """
            46.34 84.36 374.18 239.79 3 66.96 380.18 242.79
            46.34 248.19 285.47 325.9 16.8 242.79 291.47 357
            294.47 248.19 374.18 325.9 291.47 242.79 429 343.2 383.18 248.19 394.18 325.9
            258.1 87.36 110.08 33.12
            187.9 16.8 56.2 44.16
            """,
        ),
    ],
)
def test_panels_bars_and_legends_of_each_place_share_the_sheet(place, sheets_place, more, found):
    boxes = boxes_of(layout(two_rows(place, sheets_place, **more)))
    assert boxes == [pytest.approx([float(n) for n in row.split()], abs=0.011) for row in found.strip().splitlines()]


def test_strokes_and_contours_are_one_curve_with_gaps():
    strokes = segments(np.array([1.0, 4.0]), np.array([-2.0, 3.0]), np.array([5.0, 7.0]), BLUE, 1.25)
    np.testing.assert_equal(strokes.x, [1.0, 1.0, 1.0, 4.0, 4.0, 4.0])
    np.testing.assert_equal(strokes.y, [-2.0, 5.0, math.nan, 3.0, 7.0, math.nan])
    assert (strokes.colour, strokes.width, strokes.whole) == (BLUE, 1.25, True)
    x, y = np.array([0.0, 1.0, 2.0, 3.0]), np.array([10.0, 14.0])
    z = np.array([[0.0, 4.0, 0.0, 8.0], [0.0, 4.0, 0.0, 8.0]])
    a, b = contour(x, y, z, 2.0)
    assert np.isnan(a).tolist() == np.isnan(b).tolist() == [False, False, True, False, False, True, False, False]
    assert sorted(np.round(a[np.isfinite(a)], 9).tolist()) == [0.5, 0.5, 1.5, 1.5, 2.25, 2.25]
    assert sorted(b[np.isfinite(b)].tolist()) == [10.0, 10.0, 10.0, 14.0, 14.0, 14.0]
    assert [each.size for each in contour(x, y, z, 99.0)] == [0, 0]


def test_the_region_between_two_levels_has_a_ring_around_it_and_one_around_its_hole():
    at = np.arange(5.0)
    z = np.hypot(*(np.meshgrid(at - 2.0, 1.5 * (at - 2.0))))
    rings = region(at, 10.0 * at, z, 0.5, 1.0)
    areas = [0.5 * abs(float(np.sum(r[:-1, 0] * r[1:, 1] - r[1:, 0] * r[:-1, 1]))) for r in rings]
    # linear between the nodes: corners at 1 and 2/3 of a cell, and at half of that
    assert sorted(areas) == pytest.approx(sorted([2.0 * 10.0 * 2.0 / 3.0, 0.25 * 2.0 * 10.0 * 2.0 / 3.0]), rel=1e-9)
    assert all(np.array_equal(ring[0], ring[-1]) for ring in rings)


def test_an_area_and_stairs_of_unlike_values():
    x, low, high = np.array([0.0, 1.0, 3.0, 4.0]), np.array([1.0, 2.0, math.nan, 5.0]), np.array([6.0, 7.0, 8.0, 9.5])
    area = between(x, low, high, SKY, 0.4, "band")
    assert [ring.tolist() for ring in area.rings] == [[[0, 1], [1, 2], [1, 7], [0, 6]], [[4, 5], [4, 9.5]]]
    assert (area.colour, area.opacity, area.label) == (SKY, 0.4, "band")
    bars, outline = stairs(np.array([1.0, 2.0, 5.0]), np.array([3.0, 7.0]), SKY, GREY)
    assert [each.tolist() for each in (bars.at, bars.start, bars.end, bars.breadth)] == [
        [1.5, 3.5],
        [0, 0],
        [3, 7],
        [1, 3],
    ]
    assert [outline.x.tolist(), outline.y.tolist()] == [[1, 1, 2, 2, 5, 5], [0, 3, 3, 7, 7, 0]]
    assert (bars.colour, bars.upright, outline.colour, outline.width) == (SKY, True, GREY, 0.8)
    sheet, panels = grid(3.0, 2.0, 2, 3, share_y=True)
    assert [(panel.row, panel.column) for panel in panels] == [(0, 0), (0, 1), (0, 2), (1, 0), (1, 1), (1, 2)]
    assert (sheet.width, sheet.height, len(sheet.heights), len(sheet.widths), sheet.share_y) == (3.0, 2.0, 2, 3, True)
    axis = rows(("first", "second", "third"), 7.0)
    assert (axis.low, axis.high, axis.words, axis.size, axis.grid) == (
        2.6,
        -0.6,
        {0: "first", 1: "second", 2: "third"},
        7.0,
        False,
    )


@pytest.mark.parametrize(
    ("label", "lines"),
    [
        ("a: 1 / 2", ["a: 1 / 2"]),
        ("x" * 44, ["x" * 44]),
        ("x" * 45, ["x" * 44, "x"]),
        (
            "pointing error of the body: 300 urad rms / 600 urad rms about each axis of it",
            ["pointing error of the body:", "300 urad rms /", "600 urad rms about each axis of it"],
        ),
        ("word " * 40 + ": 1", [" ".join(["word"] * 9), " ".join(["word"] * 8) + "…", "1"]),
        (
            "a long name of an assumption\n of two lines / the other",
            ["a long name of an assumption of two lines /", "the other"],
        ),
        (f"{'word ' * 8}four / the other", [" ".join(["word"] * 8), "four /", "the other"]),  # no stroke of its own
    ],
)
def test_a_label_is_broken_behind_the_assumption_and_between_its_values(label, lines):
    assert in_lines(label).split("\n") == lines


def test_bars_of_swings_to_either_side_without_bound_and_without_value():
    panel = Panel(0, 0)
    ends = [(1.0, 5.0), (-math.inf, 2.5), (math.nan, 7.0), (math.inf, math.nan), (3.0, 3.0)]
    swing_bars(panel, [f"row {k}" for k in range(5)], ends, 3.0)
    bars = [
        (*(float(each[0]) for each in (b.at, b.start, b.end, b.breadth)), b.colour, b.opacity)
        for b in panel.all_of(Bars)
    ]
    assert bars == [
        (0.0, 3.0, 1.0, 0.7, ORANGE, 1.0),
        (0.0, 3.0, 5.0, 0.7, BLUE, 1.0),
        (1.0, 3.0, 3.0 - 1.4 * 4.0, 0.7, ORANGE, 0.5),
        (1.0, 3.0, 2.5, 0.7, BLUE, 1.0),
        (2.0, 3.0, 7.0, 0.7, BLUE, 1.0),
        (3.0, 3.0, 3.0 + 1.4 * 4.0, 0.7, ORANGE, 0.5),
        (4.0, 3.0, 3.0, 0.7, ORANGE, 1.0),
        (4.0, 3.0, 3.0, 0.7, BLUE, 1.0),
    ]
    assert [(w.text, w.x, w.y, w.colour, w.shift, w.of_panel) for w in panel.all_of(Words)] == [
        (text, 1.0, row, GREY, (5.0, 0.0), "x")
        for row, text in enumerate(
            ("", "lower: without bound", "lower: no value", "lower: without bound, higher: no value", "no change")
        )
    ]
    assert [(rule.at, rule.upright, rule.width) for rule in panel.all_of(Rule)] == [(3.0, True, 0.8)]
    assert panel.y.words == {float(k): f"row {k}" for k in range(5)}
    for value, shown in ((-2.0, -2.0 + 1.4 * 2.0), (0.0, 1.4)):  # without any swing that is finite
        alone = Panel(0, 0)
        swing_bars(alone, ["a"], [(math.inf, math.nan)], value)
        assert [float(b.end[0]) for b in alone.all_of(Bars)] == [pytest.approx(shown)]
    key = swing_legend("input", "below", 3)
    assert [(e.label, e.colour) for e in key.only] == [("input lower", ORANGE), ("input higher", BLUE)]
    assert (key.place, key.columns) == ("below", 3)


def test_a_figure_of_an_odd_name_has_an_id_and_a_title_that_are_sound():
    hatched = Area((RING,), BLUE, hatched=True)
    figure = Figure("a b/c.é_1-2", 'says "x" & <y>', "", one(hatched), {"x (m)": np.array([1.23456, math.nan])})
    assert figure.id == "a-b-c.-_1-2"
    assert figure.labelled.startswith('<svg role="img" aria-label="says &quot;x&quot; &amp; &lt;y&gt;" ')
    assert figure.labelled.count('id="a-b-c.-_1-2-1"') == 1 and 'fill="url(#a-b-c.-_1-2-1)"' in figure.labelled
    assert figure.rows(3) == [("1.23",), ("",)]
    assert (bool(figure.plot), figure.static.plot, figure.static.title) == (True, "", figure.title)
    figure.take("<svg other", "{}")
    assert (figure.svg, figure.plot) == ("<svg other", "{}")


def test_what_stands_at_no_place_of_an_axis_is_in_neither_form():
    lost = Words("below", 1.0, -1.0), Words("at none", 1.0, 0.0), Words("nowhere", math.nan, 4.0)
    spans = [Span(math.nan, 4.0, upright, SKY) for upright in (False, True)]
    sheet = one(Line(X, Y), Words("there", 1.0, 4.0), Words("beside", 1.0, -1.0, of_panel="y"), *lost, *spans)
    sheet.panels[0].y.log = True
    plot = turned(sheet)["layout"]
    assert [each["text"] for each in plot["annotations"]] == ["there", "beside"] and not plot["shapes"]
    assert not [each for each in parts(sheet, "rect") if each.get("fill") == SKY]


@pytest.mark.parametrize("upright", [True, False])
def test_a_legend_without_a_place_keeps_clear_of_bars(upright):
    at, none = np.array([3.0, 4.0]), np.zeros(2)
    sheet = one(Bars(at, none, np.array([1.0, 1.0]), np.ones(2), BLUE, label="bars", upright=upright))
    sheet.panels[0].legend = Legend()
    for which in ("x", "y"):
        axis = getattr(sheet.panels[0], which)
        axis.low, axis.high = (0.0, 4.5) if (which == "x") is upright else (0.0, 1.02)
    found = layout(sheet)
    (key,), (placed,) = found.keys, found.placed
    left, top, right, bottom = placed.inner
    assert (key.x < (left + right) / 2.0) if upright else (key.y > (top + bottom) / 2.0)


def three_unlike_panels():
    """A panel over two, with what `every_kind` has not: turned axes, open markers, lying bars, legends beside."""
    sheet = Sheet(5.0, 4.0, (1.0, 2.0), (2.0, 1.0), legend=Legend("right", 1, "Key", GREY, 7.0))
    sheet.heading, sheet.heading_at_left, sheet.heading_colour = "Left <head>", True, BLUE
    wide, low, ring = sheet.panel(0, 0, 2), sheet.panel(1, 0), sheet.panel(1, 1)
    x, apart = np.array([0.0, 1.0, 3.0]), np.array([0.0, 1.0])
    wide.add(
        Line(x, x * x, BLUE, "-.", 0.8, "two\nlines", marker="^", size=4.0, edge=BLACK),
        Rule(2.0, True, ORANGE, (2.0, 1.0), 0.5, "rule"),
        Line(x, 3 * x, VERMILION, "", label="open", marker="o", face="", edge_width=0.4),
        Line(x, 4 * x, SKY, "", marker="|", size=3.0),
        Span(1.0, math.inf, False, SKY, 0.15, "shade"),
    )
    wide.x, wide.y, wide.framed = Axis("x (m)", low=3.0, high=0.0, most=3), Axis("y", size=7.0, most=4), True
    low.add(
        Bars(apart, apart + 1.0, 4.0 - apart, 0.5 - apart / 4, VERMILION, opacity=0.5, edge=BLACK, label="lying"),
        Words("right & mid", 4.0, 0.0, GREY, 6.0, "end", "bottom", (-2.0, 5.0), box=True),
        Words("gone", math.nan, 0.0),
        Words("", 1.0, 0.0),
    )
    low.y, low.x, low.legend = rows(["first", "second\nrow"], 7.0), Axis("value (dB)", grid=False), Legend("below", 2)
    outer, inner = ([[1.0, 1.0], [10.0, 1.0], [10.0, 100.0]], [[2.0, 1.5], [5.0, 1.5], [5.0, 3.0]])
    ring.add(Area((np.array(outer), np.array(inner)), BLUE, 0.7, "ring", GREY, 0.6))
    ring.x, ring.y = Axis("f (Hz)", log=True, most=4), Axis(log=True, labelled=False)
    ring.title, ring.title_size = "C", 7.5
    return sheet


def wrapped(text):
    return textwrap.wrap(text, 108, break_long_words=False, break_on_hyphens=False)


def test_a_picture_of_three_unlike_panels_is_the_same_to_a_hundredth_of_a_point():
    drawn = svg_of(three_unlike_panels()).split("\n")
    assert [part for line in drawn[1:-2] for part in wrapped(line)] == [
        '<text x="3.00" y="11.55" font-size="9" fill="#0072B2">Left &lt;head&gt;</text>',
        '<path d="M295.93 22.20V80.39M121.59 22.20V80.39" stroke="#dddddd" stroke-width="0.6" fill="none"/>',
        '<path d="M34.42 77.74H295.93M34.42 33.66H295.93" stroke="#dddddd" stroke-width="0.6" fill="none"/>',
        '<svg x="34.42" y="22.20" width="261.51" height="58.19"><g transform="translate(-34.42 -22.20)">',
        '<path d="M295.93 77.74L208.76 73.33L34.42 38.07" fill="none" stroke="#0072B2" stroke-width="0.8"',
        'stroke-dasharray="5.12 1.28 0.8 1.28"/>',
        '<path d="M293.93 79.74h4l-2 -4ZM206.76 75.33h4l-2 -4ZM32.42 40.07h4l-2 -4Z" fill="#0072B2" stroke="#000000"',
        'stroke-width="1"/>',
        '<path d="M121.59 80.39V22.20" fill="none" stroke="#E69F00" stroke-width="0.5" stroke-dasharray="1 0.5"/>',
        '<path d="M292.93 77.74a3 3 0 1 0 6 0a3 3 0 1 0 -6 0ZM205.76 64.52a3 3 0 1 0 6 0a3 3 0 1 0 -6 0ZM31.42',
        '38.07a3 3 0 1 0 6 0a3 3 0 1 0 -6 0Z" fill="none" stroke="#D55E00" stroke-width="0.4"/>',
        '<path d="M295.93 76.24v3M208.76 58.61v3M34.42 23.34v3" fill="none" stroke="#56B4E9" stroke-width="1"/>',
        '<rect x="34.42" y="22.20" width="261.51" height="51.13" fill="#56B4E9" fill-opacity="0.15"/>',
        "</g></svg>",
        '<path d="M34.42 22.20V80.39H295.93V22.20ZM295.93 80.39v3.5M121.59 80.39v3.5M34.42 77.74h-3.5M34.42',
        '33.66h-3.5" stroke="#1b1f24" stroke-width="0.8" fill="none"/>',
        '<text x="295.93" y="95.44" font-size="9" text-anchor="middle">0</text>',
        '<text x="121.59" y="95.44" font-size="9" text-anchor="middle">2</text>',
        '<text x="27.92" y="80.19" font-size="7" text-anchor="end">0</text>',
        '<text x="27.92" y="36.11" font-size="7" text-anchor="end">10</text>',
        '<text x="165.18" y="109.24" font-size="9" text-anchor="middle">x (m)</text>',
        '<text x="10.56" y="54.44" font-size="9" text-anchor="middle" transform="rotate(-90 10.56 51.29)">y</text>',
        '<svg x="34.42" y="123.49" width="168.34" height="116.37"><g transform="translate(-34.42 -123.49)">',
        '<path d="M42.07 142.00H195.11V168.45H42.07ZM93.08 201.51H144.10V214.73H93.08Z" fill="#D55E00"',
        'fill-opacity="0.5" stroke="#000000" stroke-width="0.5"/>',
        "</g></svg>",
        '<path d="M34.42 123.49V239.86H202.76M42.07 239.86v3.5M93.08 239.86v3.5M144.10 239.86v3.5M195.11',
        '239.86v3.5M34.42 155.22h-3.5M34.42 208.12h-3.5" stroke="#1b1f24" stroke-width="0.8" fill="none"/>',
        '<text x="42.07" y="254.91" font-size="9" text-anchor="middle">1</text>',
        '<text x="93.08" y="254.91" font-size="9" text-anchor="middle">2</text>',
        '<text x="144.10" y="254.91" font-size="9" text-anchor="middle">3</text>',
        '<text x="195.11" y="254.91" font-size="9" text-anchor="middle">4</text>',
        '<text x="27.92" y="157.67" font-size="7" text-anchor="end">first</text>',
        '<text x="27.92" y="206.37" font-size="7" text-anchor="end"><tspan x="27.92" y="206.37">second</tspan><tspan',
        'x="27.92" y="214.77">row</tspan></text>',
        '<text x="118.59" y="268.71" font-size="9" text-anchor="middle">value (dB)</text>',
        '<rect x="159.27" y="143.02" width="33.84" height="7.20" fill="#ffffff" fill-opacity="0.75"/>',
        '<text x="193.11" y="148.72" font-size="6" text-anchor="end" fill="#777777">right &amp; mid</text>',
        '<path d="M215.59 123.49V239.86M292.10 123.49V239.86" stroke="#dddddd" stroke-width="0.6" fill="none"/>',
        '<path d="M211.76 234.57H295.93M211.76 181.67H295.93M211.76 128.78H295.93" stroke="#dddddd"',
        'stroke-width="0.6" fill="none"/>',
        '<svg x="211.76" y="123.49" width="84.17" height="116.37"><g transform="translate(-211.76 -123.49)">',
        '<path d="M215.59 234.57L292.1 234.57L292.1 128.78ZM238.62 225.26L269.07 225.26L269.07 209.33Z"',
        'fill="#0072B2" fill-opacity="0.7" fill-rule="evenodd" stroke="#777777" stroke-width="0.6"/>',
        "</g></svg>",
        '<path d="M211.76 123.49V239.86H295.93M215.59 239.86v3.5M292.10 239.86v3.5M211.76 234.57h-3.5M211.76',
        "181.67h-3.5M211.76 128.78h-3.5M212.08 239.86v2M215.59 239.86v2M238.62 239.86v2M252.09 239.86v2M261.65",
        "239.86v2M269.07 239.86v2M275.13 239.86v2M280.25 239.86v2M284.69 239.86v2M288.60 239.86v2M292.10",
        "239.86v2M211.76 239.70h-2M211.76 236.99h-2M211.76 234.57h-2M211.76 218.65h-2M211.76 209.33h-2M211.76",
        "202.72h-2M211.76 197.60h-2M211.76 193.41h-2M211.76 189.87h-2M211.76 186.80h-2M211.76 184.09h-2M211.76",
        "181.67h-2M211.76 165.75h-2M211.76 156.44h-2M211.76 149.83h-2M211.76 144.70h-2M211.76 140.51h-2M211.76",
        '136.97h-2M211.76 133.90h-2M211.76 131.20h-2M211.76 128.78h-2" stroke="#1b1f24" stroke-width="0.8"',
        'fill="none"/>',
        '<text x="215.59" y="254.91" font-size="9" text-anchor="middle">1</text>',
        '<text x="292.10" y="254.91" font-size="9" text-anchor="middle">10</text>',
        '<text x="253.84" y="268.71" font-size="9" text-anchor="middle">f (Hz)</text>',
        '<text x="211.76" y="118.61" font-size="7.5">C</text>',
        '<rect x="96.45" y="276.28" width="20.00" height="6.40" fill="#D55E00" fill-opacity="0.5" stroke="#000000"',
        'stroke-width="0.5"/>',
        '<text x="121.45" y="282.28" font-size="8">lying</text>',
        '<text x="310.93" y="29.45" font-size="7" fill="#777777">Key</text>',
        '<path d="M310.93 37.29h20" fill="none" stroke="#0072B2" stroke-width="0.8" stroke-dasharray="5.12 1.28 0.8',
        '1.28"/>',
        '<path d="M318.93 39.29h4l-2 -4Z" fill="#0072B2" stroke="#000000" stroke-width="1"/>',
        '<text x="335.93" y="39.74" font-size="7" fill="#777777"><tspan x="335.93" y="39.74">two</tspan><tspan',
        'x="335.93" y="48.14">lines</tspan></text>',
        '<path d="M310.93 55.35h20" fill="none" stroke="#E69F00" stroke-width="0.5" stroke-dasharray="1 0.5"/>',
        '<text x="335.93" y="57.80" font-size="7" fill="#777777">rule</text>',
        '<path d="M317.93 65.01a3 3 0 1 0 6 0a3 3 0 1 0 -6 0Z" fill="none" stroke="#D55E00" stroke-width="0.4"/>',
        '<text x="335.93" y="67.46" font-size="7" fill="#777777">open</text>',
        '<rect x="310.93" y="71.47" width="20.00" height="6.40" fill="#56B4E9" fill-opacity="0.15"/>',
        '<text x="335.93" y="77.12" font-size="7" fill="#777777">shade</text>',
        '<rect x="310.93" y="81.13" width="20.00" height="6.40" fill="#D55E00" fill-opacity="0.5" stroke="#000000"',
        'stroke-width="0.5"/>',
        '<text x="335.93" y="86.78" font-size="7" fill="#777777">lying</text>',
        '<rect x="310.93" y="90.79" width="20.00" height="6.40" fill="#0072B2" fill-opacity="0.7" stroke="#777777"',
        'stroke-width="0.5"/>',
        '<text x="335.93" y="96.44" font-size="7" fill="#777777">ring</text>',
    ]


def test_the_interactive_form_of_three_unlike_panels_has_what_each_legend_switches():
    plot = plot_of(three_unlike_panels())
    of = plot.pop("layout")
    assert {key: of[key] for key in interactive._COMMON} == interactive._COMMON
    axes = [of[f"{which}axis{number}"] for which in "xy" for number in ("", 2, 3)]
    assert [axis["range"] for axis in axes] == [
        [3, 0],
        [0.85, 4.15],
        [-0.05, 1.05],
        [-0.6, 12.6],
        [1.6, -0.6],
        [-0.1, 2.1],
    ]
    assert [axis["showgrid"] for axis in axes] == [True, False, True, True, False, True]
    assert wrapped(json.dumps({**plot, "drawn": [of["shapes"], of["annotations"]]}, ensure_ascii=False)) == [
        '{"size": [480.0, 384.0], "keys": [{"title": "", "entries": [{"label": "lying", "area": "rgba(213,94,0,0.5)",',
        '"data": [3], "shapes": []}]}, {"title": "Key", "entries": [{"label": "two\\nlines", "line": {"color":',
        '"#0072B2", "width": 1.07, "dash": "dashdot"}, "marker": {"symbol": "triangle-up", "size": 5.33, "color":',
        '"#0072B2", "line": {"color": "#000000", "width": 1.33}}, "data": [0], "shapes": []}, {"label": "rule",',
        '"line": {"color": "#E69F00", "width": 0.67, "dash": "1.33px,0.67px"}, "data": [], "shapes": [0]}, {"label":',
        '"open", "marker": {"symbol": "circle-open", "size": 8.0, "color": "#D55E00", "line": {"color": "#D55E00",',
        '"width": 0.53}}, "data": [1], "shapes": []}, {"label": "shade", "area": "rgba(86,180,233,0.15)", "data": [],',
        '"shapes": [1]}, {"label": "lying", "area": "rgba(213,94,0,0.5)", "data": [3], "shapes": []}, {"label":',
        '"ring", "area": "rgba(0,114,178,0.7)", "data": [], "shapes": [2]}]}], "data": [{"xaxis": "x", "yaxis": "y",',
        '"name": "two<br>lines", "type": "scatter", "mode": "lines+markers", "x": [0, 1, 3], "y": [0, 1, 9],',
        '"hovertemplate": "x: %{x:.5~g} m<br>y: %{y:.5~g}<extra>%{fullData.name}</extra>", "line": {"color":',
        '"#0072B2", "width": 1.07, "dash": "dashdot", "shape": "linear", "simplify": false}, "marker": {"symbol":',
        '"triangle-up", "size": 5.33, "color": "#0072B2", "line": {"color": "#000000", "width": 1.33}}}, {"xaxis":',
        '"x", "yaxis": "y", "name": "open", "type": "scatter", "mode": "markers", "x": [0, 1, 3], "y": [0, 3, 9],',
        '"hovertemplate": "x: %{x:.5~g} m<br>y: %{y:.5~g}<extra>%{fullData.name}</extra>", "marker": {"symbol":',
        '"circle-open", "size": 8.0, "color": "#D55E00", "line": {"color": "#D55E00", "width": 0.53}}}, {"xaxis":',
        '"x", "yaxis": "y", "name": "", "type": "scatter", "mode": "markers", "x": [0, 1, 3], "y": [0, 4, 12],',
        '"hovertemplate": "x: %{x:.5~g} m<br>y: %{y:.5~g}<extra>%{fullData.name}</extra>", "marker": {"symbol":',
        '"line-ns-open", "size": 4.0, "color": "#56B4E9", "line": {"color": "#56B4E9", "width": 1.33}}}, {"xaxis":',
        '"x2", "yaxis": "y2", "name": "lying", "type": "bar", "orientation": "h", "x": [3, 1], "y": [0, 1], "width":',
        '[0.5, 0.25], "base": [1, 2], "marker": {"color": "rgba(213,94,0,0.5)", "line": {"width": 0.5, "color":',
        '"#000000"}}, "hovertext": ["first<br>value: 1 to 4 dB", "second row<br>value: 2 to 3 dB"], "hovertemplate":',
        '"%{hovertext}<extra>%{fullData.name}</extra>"}], "panels": [{"x": "xaxis", "y": "yaxis", "inner": [45.9,',
        '29.6, 394.6, 107.2], "outer": [6.9, 22.4, 402.6, 148.6], "titles": {"xaxis": "x (m)", "yaxis": "y"}}, {"x":',
        '"xaxis2", "y": "yaxis2", "inner": [45.9, 164.6, 270.3, 319.8], "outer": [4.0, 157.4, 278.3, 380.0],',
        '"titles": {"xaxis2": "value (dB)", "yaxis2": ""}}, {"x": "xaxis3", "y": "yaxis3", "inner": [282.3, 164.6,',
        '394.6, 319.8], "outer": [278.3, 148.6, 402.6, 361.3], "titles": {"xaxis3": "f (Hz)", "yaxis3": ""}}],',
        '"scales": [], "heading": [{"text": "Left <head>", "color": "#0072B2"}], "ratio": false, "drawn": [[{"type":',
        '"line", "layer": "above", "x0": 2, "x1": 2, "xref": "x", "y0": 0, "y1": 1, "yref": "y domain", "line":',
        '{"color": "#E69F00", "width": 0.67, "dash": "1.33px,0.67px"}}, {"type": "rect", "layer": "below", "x0": 0,',
        '"x1": 1, "xref": "x domain", "y0": 1, "y1": 12.6, "yref": "y", "fillcolor": "rgba(86,180,233,0.15)", "line":',
        '{"width": 0}}, {"type": "path", "path": "M1,1L10,1L10,100ZM2,1.5L5,1.5L5,3Z", "fillrule": "evenodd", "xref":',
        '"x3", "yref": "y3", "layer": "between", "fillcolor": "rgba(0,114,178,0.7)", "line": {"color": "#777777",',
        '"width": 0.8}}], [{"text": "right &amp; mid", "showarrow": false, "borderpad": 0, "font": {"size": 8.0,',
        '"color": "#777777"}, "x": 4, "xref": "x2", "xshift": -2.67, "y": 0, "yref": "y2", "yshift": 6.67, "xanchor":',
        '"right", "yanchor": "bottom", "bgcolor": "rgba(255,255,255,0.75)"}, {"text": "C", "xref": "x3 domain",',
        '"yref": "y3 domain", "x": 0, "y": 1, "yshift": 3, "xanchor": "left", "yanchor": "bottom", "showarrow":',
        'false, "font": {"size": 12}}]]}',
    ]


@pytest.mark.parametrize(
    ("both", "said"),
    [
        *(((2.0, 2.0), "no change"), ((1.0, 3.0), ""), ((2.0, 3.0), ""), ((math.nan, 3.0), "lower: no value")),
        *(
            ((1.0, math.inf), "higher: without bound"),
            ((-math.inf, math.nan), "lower: without bound, higher: no value"),
        ),
    ],
)
def test_a_row_of_bars_says_what_they_do_not_show(both, said):
    (panel,) = one().panels
    swing_bars(panel, ["a"], [both], 2.0)
    (remark,) = panel.all_of(Words)
    assert (remark.text, remark.x, remark.y, remark.colour, remark.shift, remark.of_panel) == (
        said,
        1.0,
        0,
        GREY,
        (5, 0),
        "x",
    )
    assert [bar.colour for bar in panel.all_of(Bars)] == [
        colour
        for end, colour in sorted(zip(both, (ORANGE, BLUE), strict=True), key=lambda b: -abs(b[0] - 2.0))
        if not math.isnan(end)
    ]


def test_a_figure_has_its_title_as_text_alternative_and_a_hatching_of_its_own():
    hatched = Area((np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]]),), BLACK, hatched=True)
    figure = Figure("a b/é", 'A "quoted" <title> & more', "c", one(hatched), {"x": np.array([1.5]), "n": ("a",)})
    assert figure.id == "a-b--"
    assert 'role="img" aria-label="A &quot;quoted&quot; &lt;title&gt; &amp; more"' in figure.labelled
    assert (
        'id="a-b---1"' in figure.labelled
        and 'fill="url(#a-b---1)"' in figure.labelled
        and "hatch" not in figure.labelled
    )
    assert (figure.static.plot, figure.static.name, figure.rows(3)) == ("", "a b/é", [("1.5", "a")])
    figure.take("<svg kept/>", "kept")
    assert (figure.svg, figure.plot, figure.labelled) == (
        "<svg kept/>",
        "kept",
        '<svg role="img" aria-label="A &quot;quoted&quot; &lt;title&gt; &amp; more" kept/>',
    )


def test_a_figure_has_the_forms_that_it_is_given_and_draws_its_own_where_it_is_changed():
    sheet, (panel,) = grid(3.0, 2.0)
    panel.add(Line(np.array([1.0, 2.0]), np.array([3.0, 5.0]), label="a curve"))
    figure = Figure("name", "A <title>", "caption", sheet, {"x (m)": np.array([1.25, 2.5]), "word": ("one", "two")})
    drawn = figure.svg, figure.plot
    figure.take("<svg width='1'>earlier</svg>", '{"earlier": 1}')
    assert (figure.svg, figure.plot) == ("<svg width='1'>earlier</svg>", '{"earlier": 1}')
    assert figure.labelled == '<svg role="img" aria-label="A &lt;title&gt;" width=\'1\'>earlier</svg>'
    still = figure.static
    assert (still.svg, still.plot, still.alive, figure.alive) == (drawn[0], "", False, True)
    assert "earlier" not in drawn[0] and json.loads(drawn[1])["data"][0]["name"] == "a curve"
    assert figure.rows(3) == [("1.25", "one"), ("2.5", "two")]


@pytest.mark.parametrize("ticks", [{0.0: "one", 2.0: "two\nlines"}, {0.0: "two\nlines", 2.0: "one"}])
def test_the_title_of_an_axis_stands_below_its_highest_tick_wherever_that_is(ticks):
    found = parts(one(Line(X, Y), x={"ticks": ticks, "title": "time (s)"}), "text")
    (title,) = (float(each.get("y")) for each in found if each.text == "time (s)")
    lowest = max(float(line.get("y")) for each in found for line in each if line.text == "lines")
    assert title == pytest.approx(lowest + 1.2 * 9.0 + 3.0, abs=0.011)  # a line of its size, and what is free


def test_a_legend_above_that_is_wider_than_its_panel_ends_where_the_panel_does():
    sheet, (panel,) = grid(3.0, 2.5)
    panel.add(Line(X, Y, label="a label that is about as wide as the sheet is"))
    panel.legend = Legend("above")
    (key,), (placed,) = layout(sheet).keys, layout(sheet).placed
    assert key.width > placed.inner[2] - placed.inner[0]
    assert key.x + key.width == pytest.approx(placed.outer[2])
    panel.marks[:] = [Line(X, Y, label="short")]
    (key,), (placed,) = layout(sheet).keys, layout(sheet).placed
    assert key.x + key.width / 2.0 == pytest.approx((placed.inner[0] + placed.inner[2]) / 2.0)


@pytest.mark.parametrize(
    ("titles", "in_rows", "in_columns"),
    [
        (("first", "", "last"), ["first", "last", "last"], ["first", "first", "last"]),
        (("first", "second", ""), ["first", "second", "second"], ["first", "second", "first"]),
        (("", "second", "last"), ["last", "second", "last"], ["second", "second", "last"]),
    ],
)
def test_panels_that_share_an_axis_without_a_title_have_that_of_the_lowest_and_of_the_first(
    titles, in_rows, in_columns
):
    sheet, panels = grid(4.0, 4.0, 3, 1, share_x=True)
    for panel, title in zip(panels, titles, strict=True):
        panel.x.title = title
    assert [placed.x_title for placed in layout(sheet).placed] == in_rows
    sheet, panels = grid(6.0, 2.0, 1, 3, share_y=True)
    for panel, title in zip(panels, titles, strict=True):
        panel.y.title = title
    assert [placed.y_title for placed in layout(sheet).placed] == in_columns
    sheet.share_y = False
    assert [placed.y_title for placed in layout(sheet).placed] == [*titles]


@pytest.mark.parametrize(("columns", "title"), [(1, "kind"), (2, "A title kind")])
def test_the_legend_of_a_panel_has_the_panels_title_where_there_are_others(columns, title):
    sheet, panels = grid(6.0, 3.0, 1, columns)
    for panel in panels:
        panel.add(Line(X, Y, label="a"))
    panels[0].title, panels[0].legend = "A title", Legend("above", title="kind")
    (key,) = turned(sheet)["keys"]
    assert key["title"] == title


@pytest.mark.parametrize(
    ("place", "of", "gaps"),
    [
        ("above", "outer", (None, 0.0, None, None)),
        ("below", "outer", (None, None, None, 0.0)),
        ("upper left", "inner", (6.0, 3.0, None, None)),
        ("upper right", "inner", (None, 3.0, 6.0, None)),
        ("lower left", "inner", (6.0, None, None, 3.0)),
        ("lower right", "inner", (None, None, 6.0, 3.0)),
    ],
)
def test_the_legend_of_a_panel_stands_at_its_edge_or_in_its_corner(place, of, gaps):
    """Gaps at the left, above, at the right and below, in points; at an edge it is in the middle of the data."""
    sheet = one(Line(X, Y, label="a"), Line(X, Y, VERMILION, label="b"), x={"title": "time (s)"}, y={"title": "y"})
    sheet.panels[0].legend, sheet.panels[0].title = Legend(place, 2), "title"
    (key,), (placed,) = layout(sheet).keys, layout(sheet).placed
    left, top, right, bottom = getattr(placed, of)
    found = (key.x - left, key.y - top, right - key.x - key.width, bottom - key.y - key.height)
    for gap, wanted in zip(found, gaps, strict=True):
        assert wanted is None or gap == pytest.approx(wanted)
    if of == "outer":
        assert key.x + key.width / 2.0 == pytest.approx((placed.inner[0] + placed.inner[2]) / 2.0)


@pytest.mark.parametrize("upright", [True, False])
def test_bars_of_which_an_end_a_place_or_a_breadth_is_not_known_are_not_drawn(upright):
    at, start, end, breadth = np.array([[1.0, 2.0, 3.0, 4.0, 5.0, 6.0]] * 4) * [[1.0], [0.0], [1.0], [0.1]]
    start[1] = end[2] = at[3] = breadth[4] = math.nan
    sheet = one(Bars(at, start, end, breadth, VERMILION, upright=upright), x={"high": 9.0}, y={"high": 9.0})
    (path,) = [each.get("d") for each in parts(sheet, "path") if each.get("fill") == VERMILION]
    assert "nan" not in svg_of(sheet) and path.count("M") == path.count("Z") == 2


@pytest.mark.parametrize(
    ("place", "gaps"),
    [
        ("above", (None, 3.0, None, None)),
        ("below", (None, None, None, 3.0)),
        ("right", (None, 9.0, 3.0, None)),
        ("upper right", (None, 9.0, 3.0, None)),
        ("lower right", (None, None, 3.0, 3.0)),
    ],
)
def test_the_legend_of_a_sheet_stands_in_the_middle_of_its_edge_or_at_the_end_of_its_right_one(place, gaps):
    """Gaps to the sheet at the left, above, at the right and below, in points."""
    sheet, panels = grid(6.0, 4.0, 1, 2)
    for panel in panels:
        panel.add(Line(X, Y, label="a"), Line(X, Y, VERMILION, label="longer"))
    sheet.legend = Legend(place, 2)
    found = layout(sheet)
    (key,) = found.keys
    own = (key.x, key.y, found.width - key.x - key.width, found.height - key.y - key.height)
    for gap, wanted in zip(own, gaps, strict=True):
        assert wanted is None or gap == pytest.approx(wanted)
    if place in ("above", "below"):
        assert own[0] == pytest.approx(own[2])
    assert all(key.x > p.outer[2] or key.y > p.outer[3] or key.y + key.height < p.outer[1] for p in found.placed)


def test_of_panels_that_share_an_axis_the_lowest_of_each_column_has_its_texts():
    sheet = Sheet(6.0, 4.0, (1.0, 1.0, 1.0), (1.0, 1.0), share_x=True)
    places = [(0, 0), (0, 1), (1, 0), (1, 1), (2, 1)]
    for row, column in places:
        sheet.panel(row, column).add(Line(X, Y))
    shown = [place for place, each in zip(places, layout(sheet).placed, strict=True) if each.x_shown]
    assert shown == [(1, 0), (2, 1)]


def test_a_panel_over_two_columns_ends_where_the_last_of_them_does_whatever_stands_between_them():
    sheet = Sheet(7.0, 4.0, (1.0, 1.0), (1.0, 2.0))
    for panel in (sheet.panel(0, 0), sheet.panel(0, 1), sheet.panel(1, 0, 2)):
        panel.add(Line(X, 1e4 * Y))
        panel.y.title = "a title"
    left, right, whole = (each.inner for each in layout(sheet).placed)
    assert (whole[0], whole[2]) == pytest.approx((left[0], right[2]))
    assert right[0] - left[2] > 20.0 and right[2] - right[0] == pytest.approx(2.0 * (left[2] - left[0]))


def test_a_legend_is_as_wide_as_its_title_and_as_high_as_the_highest_entry_of_each_row():
    sheet = one(*(Line(X, Y, label=label) for label in ("a", "b", "c\nd\ne")))
    sheet.legend = Legend("above", 2, "a title that is much wider than any of the entries below it")
    (key,) = layout(sheet).keys
    assert (key.rows, key.width) == (2, pytest.approx(scales.width_of(sheet.legend.title, 8.0)))
    assert key.height == pytest.approx(1.2 * 1.15 * 8.0 * (1 + 3 + 1))
    sheet.legend = Legend("above", 2, "t")
    (key,) = layout(sheet).keys
    assert key.width == pytest.approx(sum(key.columns) + 14.0)


def test_a_legend_of_a_sheet_without_a_place_stands_above():
    sheet = one(Line(X, Y, label="a"))
    found = []
    for place in ("best", "above"):
        sheet.legend = Legend(place)
        laid = layout(sheet)
        found.append((laid.keys[0].x, laid.keys[0].y, *laid.placed[0].inner))
    assert found[0] == found[1]


@pytest.mark.parametrize(("low", "high", "ticks"), [(40.0, 47.0, range(40, 48)), (-9000.0, 5.0, None)])
def test_a_colour_bar_has_ticks_from_its_lowest_value_on_and_room_for_the_widest(low, high, ticks):
    sheet = one(Field(X, X, np.full((X.size, X.size), high), low, high, "margin (dB)"))
    (placed,) = layout(sheet).placed
    assert ticks is None or list(placed.bar_ticks) == [float(tick) for tick in ticks]
    widest = max(scales.width_of("0" * len(text), 9.0) for text in placed.bar_ticks.values())
    assert placed.outer[2] - placed.bar[2] > widest + 10.8


def test_labels_that_differ_by_case_alone_are_two_entries_of_a_legend():
    sheet = one(Line(X, Y, label="a"), Line(X, Y, label="A"), Line(X, Y, VERMILION, label="a"))
    sheet.legend = Legend("above")
    assert [each["label"] for each in plot_of(sheet)["keys"][0]["entries"]] == ["a", "A"]


@pytest.mark.parametrize(
    ("title", "spoken_", "panel", "said"),
    [
        ("t (dB)", "s (V)", "p (m)", "t: %{z:.5~g} dB"),
        ("", "s (V)", "p (m)", "s: %{z:.5~g} V"),
        ("", "", "p (m)", "p: %{z:.5~g} m"),
    ],
)
def test_a_field_is_spoken_by_its_title_else_by_its_words_else_by_its_panel(title, spoken_, panel, said):
    sheet = one(Field(X, X, np.ones((X.size, X.size)), 0.0, 2.0, title, spoken=spoken_))
    sheet.panels[0].title = panel
    assert said in plot_of(sheet)["data"][0]["hovertemplate"]


def test_words_at_a_share_of_a_logarithmic_panel_stand_there_and_others_at_the_logarithm():
    sheet = one(Line(np.array([1.0, 1e3]), np.array([1.0, 1e3])), Words("a", 0.0, 100.0, of_panel="x"))
    sheet.panels[0].add(Words("b", 10.0, 0.25, of_panel="y"), Words("c", -1.0, 0.5, of_panel="y"))
    sheet.panels[0].x.log = sheet.panels[0].y.log = True
    found = [(each["text"], each["x"], each["y"]) for each in plot_of(sheet)["layout"]["annotations"]]
    assert found == [("a", 0, 2), ("b", 1, 0.25)]


@pytest.mark.parametrize(("opacity", "found"), [(0.0, "rgba(0,114,178,0)"), (0.5, "rgba(0,114,178,0.5)"), (1.0, BLUE)])
def test_a_colour_is_clear_to_nothing(opacity, found):
    assert interactive.clear(BLUE, opacity) == found
    assert interactive.clear("", opacity) == ""
