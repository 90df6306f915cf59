"""The interactive figures: what matplotlib drew is what plotly gets, small enough, and harmless in a page."""

import json
import math
import re
import xml.etree.ElementTree as ET

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.figure import Figure as Canvas

from microrad.report import interactive
from microrad.report.day_assumptions import Assumed, assumptions
from microrad.report.day_figures import empty
from microrad.report.figures import MOST_POINTS, STYLE, Figure, svg_of
from microrad.report.interactive_style import numbers, outlines, thin_curve, words
from microrad.report.page import pages
from microrad.report.tables import rows_of
from report_pages import assert_sound
from shipped import plain_drawn

HOSTILE = '</script><b onclick="x()">&amp; %{x} <a href="https://example.org">link</a>'
STATIC_ONLY = {"latency": "nothing was delivered", "assumptions": "no assumption was varied"}  # pictures of words alone


@pytest.fixture
def canvas():
    with mpl.rc_context(STYLE):
        yield Canvas(figsize=(6.4, 4.0), layout="constrained")


def turned(canvas):
    """The plot of a canvas, which has to be drawn first; it is plain data."""
    canvas.draw_without_rendering()
    return json.loads(interactive.text_of(interactive.plot_of(canvas)))


def only(plot):
    (trace,) = plot["data"]
    return trace


# ------------------------------------------------------------------------------------------------ kinds of artists
def test_a_line_keeps_its_points_colour_width_and_dashes(canvas):
    axes = canvas.subplots()
    axes.plot([0, 1, 2], [3.0, math.nan, 5.0], "--", color="#0072B2", linewidth=1.5, label="one")
    axes.plot([0, 1, 2], [1, 2, 3], linestyle=(0, (5, 2)), color="#D55E00", linewidth=3.0)
    axes.set(xlabel="time (s)", ylabel="rms, one axis (µrad)")
    first, second = turned(canvas)["data"]
    assert (first["x"], first["y"], first["name"]) == ([0, 1, 2], [3, None, 5], "one")
    assert first["line"] == {"color": "#0072b2", "width": 2.0, "dash": "dash", "shape": "linear", "simplify": False}
    assert (second["line"]["dash"], second["name"]) == ("20px,8px", "")
    assert first["hovertemplate"].startswith("time: %{x:.5~g} s<br>rms, one axis: %{y:.5~g} µrad<extra>")


@pytest.mark.parametrize(("style", "shape"), [("steps-pre", "vh"), ("steps-post", "hv"), ("steps-mid", "hvh")])
def test_steps_stay_steps(canvas, style, shape):
    canvas.subplots().plot([0, 1, 2], [1, 3, 2], drawstyle=style)
    assert only(turned(canvas))["line"]["shape"] == shape


def test_markers_stand_where_they_stood(canvas):
    axes = canvas.subplots()
    axes.plot(np.arange(10), np.arange(10) ** 2, "-s", markevery=[2, 5], color="#009E73", markersize=6)
    axes.plot([1], [4], "D", color="white", markeredgecolor="#000000", clip_on=False)
    line, marks, lone = turned(canvas)["data"]
    assert (line["mode"], marks["mode"], marks["x"], marks["y"]) == ("lines", "markers", [2, 5], [4, 25])
    assert (marks["marker"]["symbol"], marks["marker"]["size"], marks["marker"]["color"]) == ("square", 8, "#009e73")
    assert (lone["marker"]["symbol"], lone["marker"]["line"]["color"]) == ("diamond", "#000000")
    assert (lone["cliponaxis"], "cliponaxis" in marks) == (False, False)


def test_a_scatter_plot_knows_its_marker_again(canvas):
    axes = canvas.subplots()
    axes.scatter([1, 2], [3, 4], 16, "#0072B2", marker="o", label="kept")
    axes.scatter([5], [6], 16, "#D55E00", marker="x", label="missed")
    kept, missed = turned(canvas)["data"]
    assert (kept["marker"]["symbol"], kept["marker"]["size"], kept["x"]) == ("circle", 5.33, [1, 2])
    assert (missed["marker"]["symbol"], missed["marker"]["color"]) == ("x-thin-open", "#d55e00")


def test_an_area_between_curves_is_its_outline(canvas):
    axes = canvas.subplots()
    axes.fill_between([0, 1, 2], [0, 1, 0], [2, 3, 4], color="#56B4E9", alpha=0.5, linewidth=0, label="band")
    area = only(turned(canvas))
    assert (area["fill"], area["fillcolor"]) == ("toself", "rgba(86,180,233,0.5)")
    assert {(0, 0), (1, 1), (2, 0), (2, 4), (1, 3), (0, 2)} == set(zip(area["x"], area["y"], strict=True))


def test_bars_of_one_colour_are_one_trace_and_name_their_rows(canvas):
    axes = canvas.subplots()
    for row, wide in enumerate((2.0, -1.0)):
        axes.barh(row, wide, left=3.0, height=0.7, color="#E69F00")
    axes.barh([0, 1], [1.0, 0.5], height=0.2, color=["#0072B2", "#56B4E9"])
    axes.set_yticks([0, 1], ["aperture = 5 cm", "wavelength"])
    axes.set_xlabel("margin (dB)")
    swings, one, other = turned(canvas)["data"]
    assert (swings["base"], swings["x"], swings["y"], swings["width"]) == ([3, 3], [2, -1], [0, 1], [0.7, 0.7])
    assert swings["hovertext"] == ["aperture = 5 cm<br>margin: 3 to 5 dB", "wavelength<br>margin: 3 to 2 dB"]
    assert (one["hovertext"], other["hovertext"]) == (
        ["aperture = 5 cm<br>margin: 1 dB"],
        ["wavelength<br>margin: 0.5 dB"],
    )
    assert [t["marker"]["color"] for t in (swings, one, other)] == ["#e69f00", "#0072b2", "#56b4e9"]


def test_a_bar_that_lies_on_a_longer_one_stays_in_front_of_it(canvas):
    axes = canvas.subplots()
    for row, ends in enumerate(((5.0, 2.0), (1.0, -1.0), (2.0, 6.0))):
        colours = ("#E69F00", "#0072B2")
        for end, colour in sorted(zip(ends, colours, strict=True), key=lambda bar: -abs(bar[0])):
            axes.barh(row, end, height=0.7, color=colour)
    plot = turned(canvas)["data"]
    behind, in_front = plot[:2], plot[2:]
    assert [(t["marker"]["color"], t["x"]) for t in behind] == [("#e69f00", [5, 1]), ("#0072b2", [-1, 6])]
    assert [(t["marker"]["color"], t["x"]) for t in in_front] == [("#0072b2", [2]), ("#e69f00", [2])]


def test_a_curve_that_no_legend_shows_may_have_a_name(canvas):
    axes = canvas.subplots()
    axes.plot([0, 1], [1, 2], color="#0072B2", label="simulated")
    axes.plot([0, 1], [1, 3], "--", color="#0072B2", label="_predicted")
    axes.plot([0, 1], [1, 4], ":", color="#0072B2")
    axes.legend()
    plot = turned(canvas)
    assert [trace["name"] for trace in plot["data"]] == ["simulated", "predicted", "simulated"]
    assert [(e["label"], e["data"]) for e in plot["keys"][0]["entries"]] == [("simulated", [0, 1, 2])]


def test_a_value_between_ticks_in_words_is_its_own_and_a_row_of_numbers_has_its_title(canvas):
    axes = canvas.subplots()
    axes.plot([0.5, 61.25], [0, 1], color="#0072B2")
    axes.set_xticks([0.0, 60.0])
    axes.xaxis.set_major_formatter(lambda degrees, _: f"{degrees:g}° E")
    axes.set_yticks([0, 1], ["4", "13"])
    axes.set_ylabel("gain (V)")
    plot = turned(canvas)
    assert only(plot)["text"] == ["gain: 4 V<br>0.5° E", "gain: 13 V<br>61.25° E"]
    assert plot["layout"]["xaxis"]["ticktext"] == ["0° E", "60° E"]
    axes.set_xlabel("longitude")
    assert only(turned(canvas))["text"][1] == "gain: 13 V<br>longitude: 61.25° E"


def test_broken_bars_are_bars_with_their_begins(canvas):
    axes = canvas.subplots()
    axes.broken_barh([(1.0, 0.5), (4.0, 2.0)], (-0.3, 0.6), facecolor="#0072B2")
    axes.set_yticks([0], ["relay"])
    axes.set_xlabel("time (h)")
    bars = only(turned(canvas))
    assert (bars["type"], bars["base"], bars["x"], bars["y"], bars["width"]) == (
        "bar",
        [1, 4],
        [0.5, 2],
        [0, 0],
        [0.6] * 2,
    )
    assert bars["hovertext"][1] == "relay<br>time: 4 to 6 h"


def test_error_bars_keep_both_arms(canvas):
    axes = canvas.subplots()
    axes.errorbar([1, 2], [3, 4], xerr=[[0.1, 0.2], [0.3, 0.4]], yerr=[0.5, 0.6], fmt="o", color="#0072B2", label="p")
    points = only(turned(canvas))
    assert (points["name"], points["mode"]) == ("p", "markers")
    assert points["error_x"]["arrayminus"] == pytest.approx([0.1, 0.2])
    assert points["error_x"]["array"] == pytest.approx([0.3, 0.4])
    assert points["error_y"]["array"] == points["error_y"]["arrayminus"] == pytest.approx([0.5, 0.6])


def test_segments_and_histograms(canvas):
    left, right = canvas.subplots(1, 2)
    left.vlines([1, 2], 0.0, [5, 6], "#000000")
    right.stairs([10.0, 30.0], [0.0, 1.0, 3.0], fill=True, color="#56B4E9")
    right.stairs([10.0, 30.0], [0.0, 1.0, 3.0], color="#0072B2")
    right.set(xlabel="margin (dB)", ylabel="rows (%)")
    lines, bars, outline = turned(canvas)["data"]
    assert (lines["x"], lines["y"]) == ([1, 1, None, 2, 2], [0, 5, None, 0, 6])
    assert (bars["x"], bars["width"], bars["y"], bars["xaxis"]) == ([0.5, 2], [1, 2], [10, 30], "x2")
    assert bars["hovertext"] == ["margin: 0 to 1 dB<br>rows: 10 %", "margin: 1 to 3 dB<br>rows: 30 %"]
    assert (outline["x"], outline["y"], outline["line"]["shape"]) == ([0, 0, 1, 3, 3], [0, 10, 30, 30, 0], "hv")


@pytest.mark.parametrize("origin", ["lower", "upper"])
def test_an_image_keeps_every_value_at_its_place_with_its_words(canvas, origin):
    axes = canvas.subplots()
    values = np.array([[1.0, 2.0, math.nan], [4.0, 5.0, 6.0]])
    image = axes.imshow(values, origin=origin, vmin=0, vmax=8, aspect="auto")
    axes.set_xticks([0, 1, 2], ["a", "b", "c"])
    axes.set_yticks([0, 1], ["low", "high"])
    canvas.colorbar(image, ax=axes, label="share (%)")
    plot = turned(canvas)
    field = only(plot)
    drawn = {
        (x, y): z for y, row in zip(field["y"], field["z"], strict=True) for x, z in zip(field["x"], row, strict=True)
    }
    assert drawn == {(0, 0): 1, (1, 0): 2, (2, 0): None, (0, 1): 4, (1, 1): 5, (2, 1): 6}
    assert (field["zmin"], field["zmax"], field["showscale"]) == (0, 8, True)
    assert field["text"][field["y"].index(1)][2] == "high<br>c"
    assert "share: %{z:.5~g} %" in field["hovertemplate"]
    assert field["colorbar"]["title"]["text"] == "share (%)"
    assert (len(plot["panels"]), len(plot["scales"]), plot["scales"][0]["panel"]) == (1, 1, 0)


def test_a_mesh_keeps_its_edges(canvas):
    canvas.subplots().pcolormesh([0.0, 1.0, 3.0], [0.0, 2.0, 4.0], [[1.0, 2.0], [3.0, 4.0]], shading="flat")
    field = only(turned(canvas))
    assert (field["x"], field["y"], field["z"]) == ([0, 1, 3], [0, 2, 4], [[1, 2], [3, 4]])


def test_contours_keep_values_levels_and_hatching(canvas):
    axes = canvas.subplots()
    x, y = np.linspace(0.0, 4.0, 9), np.linspace(0.0, 2.0, 5)
    z = x[None, :] + y[:, None]
    filled = axes.contourf(x, y, z, levels=np.arange(0.0, 7.0), cmap="cividis")
    interactive.keep_values(filled, x, y, z)
    axes.contourf(x, y, (z > 3).astype(float), levels=[0.5, 1.5], colors="none", hatches=["////"])
    axes.contour(x, y, z, levels=[2.0], colors="white", linestyles=":")
    field, hatched, line = turned(canvas)["data"]
    assert (field["type"], field["z"][1][2], field["contours"]["start"], field["contours"]["size"]) == (
        "contour",
        1.5,
        0,
        1,
    )
    assert hatched["fillpattern"]["shape"] == "/"
    assert [a + b for a, b in zip(line["x"], line["y"], strict=True)] == pytest.approx([2.0] * len(line["x"]))
    assert (line["line"]["color"], line["line"]["dash"]) == ("#ffffff", "dot")


def test_lines_and_spans_over_the_panel_go_on_when_one_zooms_out(canvas):
    axes = canvas.subplots()
    axes.plot([0, 1], [1, 2])
    axes.axhline(1.5, color="#000000", linestyle="--", label="required")
    axes.axvspan(0.2, 0.4, color="#56B4E9", alpha=0.2, linewidth=0)
    axes.axvline(0.7)
    span, level, upright = turned(canvas)["layout"]["shapes"]
    assert (level["y0"], level["y1"], level["yref"], level["xref"]) == (1.5, 1.5, "y", "x domain")
    assert (span["x0"], span["x1"], span["xref"], span["yref"], span["y1"]) == (0.2, 0.4, "x", "y domain", 1)
    assert (upright["x0"], upright["xref"], upright["yref"]) == (0.7, "x", "y domain")


def test_texts_stand_where_they_stood(canvas):
    axes = canvas.subplots()
    axes.set(xscale="log", xlim=(1, 1000))
    axes.text(100.0, 0.5, "here", color="#D55E00", ha="right", va="center", rotation=30)
    axes.annotate("beside", (1, 0.25), (5, 0), axes.get_yaxis_transform(), textcoords="offset points")
    axes.set_title("15 Hz", loc="left")
    title, here, beside = turned(canvas)["layout"]["annotations"]
    assert (here["x"], here["y"], here["xref"], here["textangle"]) == (2, 0.5, "x", -30)
    assert (here["xanchor"], here["yanchor"], here["font"]["color"]) == ("right", "middle", "#d55e00")
    assert (beside["x"], beside["xref"], beside["yref"], beside["xshift"]) == (1, "x domain", "y", 6.67)
    assert (title["text"], title["y"], title["yref"]) == ("15 Hz", 1, "y domain")


# ------------------------------------------------------------------------------------------------ axes and places
def test_axes_keep_scale_limits_order_and_words(canvas):
    axes = canvas.subplots()
    axes.plot([1, 1000], [0, 1])
    axes.set(xscale="log", xlim=(1, 1000), ylim=(2.5, -0.5), xlabel="frequency (Hz)")
    axes.set_yticks([0, 1], ["first", "second"])
    layout = turned(canvas)["layout"]
    assert (layout["xaxis"]["type"], layout["xaxis"]["range"], layout["yaxis"]["range"]) == ("log", [0, 3], [2.5, -0.5])
    assert (layout["yaxis"]["tickvals"], layout["yaxis"]["ticktext"]) == ([0, 1], ["first", "second"])
    assert layout["xaxis"]["title"]["text"] == "frequency (Hz)"
    assert "tickvals" not in layout["xaxis"]


def test_panels_that_share_limits_follow_each_other_and_stand_at_their_places(canvas):
    grid = canvas.subplots(2, 2, sharex=True, sharey="row")
    for k, axes in enumerate(grid.ravel()):
        axes.plot([0, k + 1], [0, 1])
    grid[1, 0].set_xlabel("time (s)")
    plot = turned(canvas)
    layout, places = plot["layout"], [panel["inner"] for panel in plot["panels"]]
    assert [layout[f"xaxis{k}"]["matches"] for k in (2, 3, 4)] == ["x", "x", "x"]
    assert (layout["yaxis2"]["matches"], "matches" in layout["yaxis3"], layout["yaxis4"]["matches"]) == (
        "y",
        False,
        "y3",
    )
    assert (layout["xaxis"]["showticklabels"], layout["xaxis3"]["showticklabels"]) == (False, True)
    assert plot["panels"][0]["titles"]["xaxis"] == "time (s)"
    for box, axes in zip(places, grid.ravel(), strict=True):
        at = axes.get_position()
        expected = [at.x0 * 614.4, (1 - at.y1) * 384.0, at.x1 * 614.4, (1 - at.y0) * 384.0]
        assert box == pytest.approx(expected, abs=0.06)


def test_a_twin_axis_lies_over_the_first(canvas):
    axes = canvas.subplots()
    axes.plot([0, 1], [0, 1])
    twin = axes.twinx()
    twin.plot([0, 1], [10, 20])
    twin.set_ylabel("drive (V)")
    plot = turned(canvas)
    assert [(t["xaxis"], t["yaxis"]) for t in plot["data"]] == [("x", "y"), ("x", "y2")]
    assert (plot["layout"]["yaxis2"]["overlaying"], plot["layout"]["yaxis2"]["side"]) == ("y", "right")
    assert len(plot["panels"]) == 1
    assert "xaxis2" not in plot["layout"]


# ------------------------------------------------------------------------------------------------ legends
def test_a_legend_switches_its_curves_and_those_that_look_like_them(canvas):
    left, right = canvas.subplots(1, 2)
    left.plot([0, 1], [0, 1], color="#0072B2", label="loop")
    right.plot([0, 1], [2, 3], color="#0072B2")
    right.plot([0, 1], [2, 1], "--", color="#0072B2")
    left.axhline(0.5, color="#000000", linestyle=":", label="limit")
    right.plot([0, 1], [5, 5], color="#000000")
    canvas.legend(*left.get_legend_handles_labels())
    plot = turned(canvas)
    (key,) = plot["keys"]
    loop, limit = key["entries"]
    assert (loop["label"], loop["data"], loop["shapes"]) == ("loop", [0, 1, 2], [])
    assert (limit["label"], limit["data"], limit["shapes"]) == ("limit", [], [0])
    assert [trace["name"] for trace in plot["data"]] == ["loop", "loop", "loop", ""]
    assert loop["line"] == {"color": "#0072b2", "width": 1.73, "dash": "solid"}


def test_legends_of_panels_switch_their_own_curves_only(canvas):
    for axes, name in zip(canvas.subplots(1, 2), ("1 Hz", "15 Hz"), strict=True):
        axes.plot([0, 1], [0, 1], color="#0072B2", label="PID")
        axes.set_title(name, loc="left")
        axes.legend()
    assert [(k["title"], k["entries"][0]["data"]) for k in turned(canvas)["keys"]] == [("1 Hz", [0]), ("15 Hz", [1])]


# ------------------------------------------------------------------------------------------------ size
def test_decimation_keeps_ends_peaks_and_gaps():
    rng = np.random.default_rng(5)
    x = np.linspace(0.0, 1.0, 100_001)
    y = np.sin(40.0 * x) + 0.01 * rng.standard_normal(x.size)
    y[[777, 50_000]] = 9.0, -9.0
    y[60_000:60_400] = np.nan
    kept = thin_curve(x, y, 1000)
    assert kept.size <= 1000
    assert {0, 777, 50_000, 100_000} <= set(kept.tolist())
    assert np.isnan(y[kept]).any()
    assert (np.nanmax(y[kept]), np.nanmin(y[kept])) == (9.0, -9.0)
    assert np.all(np.diff(kept) > 0)
    assert list(thin_curve(x[:1000], y[:1000], 1000)) == list(range(1000))


def test_a_closed_curve_keeps_the_extremes_of_both_coordinates():
    turn = np.linspace(0.0, 2.0 * np.pi, 20_001)
    x, y = np.cos(turn), np.sin(turn)
    kept = thin_curve(x, y, 500)
    assert kept.size <= 500
    assert [f(v[kept]) for v in (x, y) for f in (np.min, np.max)] == pytest.approx([-1, 1, -1, 1], abs=1e-15)


def test_a_drawn_curve_is_thinned(canvas):
    canvas.subplots().plot(np.arange(50_000.0), np.sin(np.arange(50_000.0)))
    assert MOST_POINTS / 3 < len(only(turned(canvas))["x"]) <= MOST_POINTS


def test_numbers_have_six_digits_and_more_where_they_differ_by_little():
    assert numbers([1 / 3, 2e-9 / 3, 3.0, math.inf, math.nan]) == [0.333333, 6.66667e-10, 3, None, None]
    found = numbers(1e6 + np.array([0.0, 1e-3, 2e-3]))
    assert np.diff(found) == pytest.approx([1e-3, 1e-3], rel=1e-3)


def test_outlines_are_not_simplified_in_units_of_the_data(canvas):
    axes = canvas.subplots()
    x = np.linspace(0.0, 1e-6, 1000)
    area = axes.fill_between(x, 0.0, 1e-6 * np.sin(20e6 * x), linewidth=0)
    (ring,) = outlines(area.get_paths()[0])
    assert len(ring) > 2000


# ------------------------------------------------------------------------------------------------ in a page
def test_hostile_names_are_words_and_end_nothing(canvas):
    axes = canvas.subplots()
    axes.plot([0, 1], [0, 1], label=HOSTILE)
    axes.set(xlabel=f"{HOSTILE} (s)", title=HOSTILE)
    axes.set_yticks([0, 1], [HOSTILE, "b"])
    axes.legend()
    canvas.draw_without_rendering()
    plot = interactive.plot_of(canvas)
    text = interactive.text_of(plot)
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


def page_of(*drawn, files=False):
    env = pages()
    source = '{% from "figure.html" import drawn %}<!DOCTYPE html><html><body>{{ drawn(figures, files) }}</body></html>'
    return interactive.with_scripts(env.from_string(source).render(figures=drawn, files=files))


def test_two_pictures_of_a_page_share_no_id_and_keep_what_theirs_refer_to(canvas):
    for axes in canvas.subplots(1, 2):
        axes.fill_between([0, 1], [0, 1], hatch="////", facecolor="none")
        axes.plot([0, 1], [1, 0], "o", label='<g id="a" href="#b">')
        axes.legend()
    svg = svg_of(canvas)
    one, two = (Figure(name, "T", "C", svg, {}) for name in ("one", "two (a/b)"))
    page = page_of(one, two)
    assert_sound(page)
    for picture, prefix in ((one.labelled, "one-"), (two.labelled, "two--a-b--")):
        root = ET.fromstring(picture)
        ids = [each.get("id") for each in root.iter() if each.get("id")]
        assert len(ids) > 4
        assert ids == [each for each in ids if each.startswith(prefix)]
        drawn = [each for each in ET.fromstring(svg).iter() if each.get("{http://www.w3.org/1999/xlink}href")]
        assert picture.count("url(#") == svg.count("url(#") > 0
        assert picture.count('xlink:href="#') == len(drawn) > 0
        assert '&lt;g id="a" href="#b"&gt;' in picture  # a text is no tag
        assert "<style" not in picture  # it would hold for the whole page
    assert one.labelled == Figure("one", "T", "C", svg, {}).labelled


def test_columns_become_rows_of_text_with_gaps_left_empty():
    columns = {"input": ("a", "b", "c"), "value (m)": np.array([1.0 / 3.0, math.nan]), "n": np.array([1e9])}
    assert rows_of(columns, 3) == [("a", "0.333", "1e+09"), ("b", "", ""), ("c", "", "")]


def test_numbers_stand_below_a_picture_where_they_are_wanted(canvas):
    canvas.subplots().plot([0, 1], [0, 1])
    one = Figure("one", "T", "C", svg_of(canvas), {"input <b>": ("x&y",), "value (m)": np.array([0.25])})
    assert one.static.plot == ""
    assert one.static.svg == one.svg
    source = '{% from "figure.html" import drawn %}{{ drawn(figures, false, true) }}'
    page = pages().from_string(source).render(figures=[one.static])
    assert "<script" not in page
    assert '<th>input &lt;b&gt;</th><th class="number">value (m)</th>' in page
    assert '<td>x&amp;y</td><td class="number">0.25</td>' in page
    assert "<details" not in page_of(one)


def test_a_page_carries_the_library_once_and_only_for_interactive_figures(canvas):
    canvas.subplots().plot([0, 1], [0, 1])
    one = Figure("one", 'Title "A" <b>', "Caption", svg_of(canvas), {})
    page = page_of(one, one, files=True)
    assert page.count(interactive.library()) == 1
    assert page.index("<figcaption") < page.index(interactive.library()) < page.index("</body>")
    assert page.count(interactive.MARK) == page.count('<svg role="img" aria-label="Title &quot;A&quot; &lt;b&gt;"') == 2
    assert '<a href="figures/one.csv">' in page
    static = Figure("two", "Words", "Caption", empty("nothing to see"), {})
    assert static.plot == ""
    assert interactive.library() not in page_of(static)
    assert page_of(static).count("<script") == page_of(one).count(interactive.keyboard()) == 1
    assert 'role="img"' in page_of(static)


def test_the_library_is_whole_licensed_and_ends_no_element():
    scripts = re.findall(r"<script>(.*?)</script>", interactive.library(), re.DOTALL)
    assert len(scripts) == 2
    assert "plotly.js (cartesian - minified) v4" in scripts[0]
    assert "Licensed under the MIT license" in scripts[0]
    assert len(interactive.library().encode()) < 1.6e6
    folder = interactive.resources.files("microrad.report")
    assert "MIT License" in folder.joinpath("vendor/plotly-LICENSE.txt").read_text(encoding="utf-8")


def test_figure_text_is_the_same_each_time(canvas):
    canvas.subplots().plot([0, 1], [0, 1])
    assert svg_of(canvas).plot == svg_of(canvas).plot != ""


# ------------------------------------------------------------------------------------------------ what stays static
@pytest.mark.parametrize(
    ("draw", "why"),
    [
        (lambda axes: axes.quiver([0], [0], [1], [1]), "Quiver that is not in the coordinates"),
        (lambda axes: axes.annotate("a", (0, 0), (1, 1), arrowprops={"arrowstyle": "->"}), "an arrow"),
        (lambda axes: axes.plot([0, 1], [0, 1], marker="8"), "marker '8'"),
        (lambda axes: axes.contourf([[1, 2], [3, 4]]), "filled contours without their values"),
        (lambda axes: axes.scatter([0, 1], [0, 1], c=[0.1, 0.9]), "several sizes or colours"),
        (
            lambda axes: axes.fill_between([0, 1], [0, 1], transform=axes.get_xaxis_transform()),
            "Collection that is not in the coordinates",
        ),
        (lambda axes: axes.set_xscale("symlog"), "a symlog scale"),
        (lambda axes: axes.plot([0, 1], [0, 1], transform=axes.figure.transFigure), "coordinates of its panel"),
    ],
)
def test_what_cannot_be_turned_says_so_and_stays_a_picture(canvas, draw, why):
    draw(canvas.subplots())
    canvas.draw_without_rendering()
    with pytest.raises(interactive.StaticOnlyError, match=why):
        interactive.plot_of(canvas)
    picture = svg_of(canvas)
    assert picture.startswith("<svg")
    assert picture.plot == ""


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
    found = {"latency": empty(STATIC_ONLY["latency"]), "assumptions": assumptions([], 1.0, "ratio").svg}
    for name, picture in found.items():
        assert picture.plot == ""
        assert STATIC_ONLY[name] in picture
    assert assumptions([Assumed("a", 1.0, 2.0)], 1.5, "ratio (1)").plot != ""
