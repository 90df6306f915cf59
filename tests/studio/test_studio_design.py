"""What the studio's pages of links, pointing and day compute, without a browser."""

import base64
import json
import math
import re
import threading
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from drawn import block_lines, plot_lines
from link_files import FADING, RECEIVERS, data_with, link_file, received_with
from microrad import link
from microrad.link import study as link_study
from microrad.link.fade_series import FadeSeriesError
from microrad.link.pointing import outage as under_jitter
from microrad.mission.fields import Quantity, Share
from microrad.orbit import day as day_study
from microrad.report.day import figures as day_plots
from microrad.report.plotting.figure import Figure
from microrad.report.plotting.sheet import Axis, Line, Rule, Sheet, grid
from microrad.report.tables import Table
from microrad.report.view import Soft, View
from microrad.studio.draft.draft import Draft
from microrad.studio.pages import elements
from microrad.studio.views import day as day_view
from microrad.studio.views import link as link_view
from microrad.studio.views import plots, sliders
from microrad.studio.views import pointing as pointing_view
from microrad.studio.views.latest import Latest, shared
from waiting import HANG_S


@pytest.fixture(scope="module")
def draft(tmp_path_factory):
    return Draft.shipped(tmp_path_factory.mktemp("studio") / "mission.toml")


@pytest.fixture(scope="module")
def view(draft):
    return link_view.view(draft.link())


@pytest.fixture(scope="module")
def day(draft):
    return day_view.compute_day(draft.set("operations.runs", "2").link(), lambda done, total, what: None)


@pytest.fixture(scope="module")
def figures(day):
    """Those of the day's page by their names."""
    blocks = day_view.blocks(day)
    shown = [*blocks, *(each for view in blocks if isinstance(view, View) for each in view.blocks)]
    return {each.name: each for each in shown if isinstance(each, Figure)}


def slider_of(draft, key):
    return sliders.slider(draft.values[key])


# ------------------------------------------------------------------------------------------------------------ sliders
def test_a_slider_stands_at_its_value_and_writes_its_unit(draft):
    aperture = slider_of(draft, "terminals.leo_aperture")
    assert (aperture.label, aperture.typed, aperture.unit) == ("LEO aperture", "5 cm", "cm")
    assert aperture.at(aperture.position) == "5 cm"
    assert (aperture.at(0), aperture.at(aperture.steps)) == ("1 cm", "20 cm")
    assert aperture.at(aperture.position + 1).endswith(" cm")
    assert 5.0 < float(aperture.at(aperture.position + 1).split()[0]) < 5.2


def test_a_margin_that_was_solved_for_is_met_whatever_rounding_leaves():
    missed, solved, short = (
        link_view.Margin("communication", margin_db, 3.0) for margin_db in (2.9, 3.0 - 1e-12, 2.999)
    )
    assert (missed.met, solved.met, short.met) == (False, True, False)
    assert solved.needs == "needs 3 dB: met"


def test_a_margin_is_worded_with_its_sign_and_its_mark():
    margin = link_view.Margin("beacon", 2.0, 0.0, sign="!")
    assert (margin.words, margin.needs) == ("+2.00 dB !", "needs 0 dB: met")
    assert replace(margin, margin_db=-1.0, sign="").words == "\u22121.00 dB"
    assert replace(margin, margin_db=-1.0).needs == "needs 0 dB: MISSED"
    assert not replace(margin, possible=False).met


@pytest.mark.parametrize(
    ("required", "words"),
    [
        (3.0, "Solid line: the required 3 dB. Dashed line: 0 dB. Dot: the working point."),
        (0.0, "Solid line: the required 0 dB. Dot: the working point."),
        (-1.5, "Solid line: the required -1.5 dB. Dashed line: 0 dB. Dot: the working point."),
    ],
)
def test_the_key_of_the_map_names_the_lines_that_it_has(required, words):
    assert link_view.map_key(required) == words


def test_a_link_with_more_light_received_than_sent_is_missed(draft):
    near = draft.set("communication.distance", "1 m")
    far, close = (link_view.view(each.link()).margins for each in (draft, near))
    assert (far[0].met, far[0].needs) == (True, "needs 3 dB: met")
    assert close[0].margin_db > 100.0
    assert (close[0].met, close[0].needs) == (False, "MISSED: more light arrives than was sent")
    assert [each.met for each in close[1:]] == [each.met for each in far[1:]] == [True, True]


def test_every_position_of_every_slider_is_a_value_that_the_mission_takes(draft):
    groups = link_view.sliders(draft) | pointing_view.sliders(draft)
    every = [slider for group in groups.values() for slider in group]
    assert len(every) > 30
    for slider in every:
        about = draft.values[slider.key].about
        for position in (0, slider.steps // 3, slider.position, slider.steps) if slider.scale != "none" else ():
            typed = slider.at(position)
            value = about.quantity.read(typed if about.unit else float(typed))  # raises where it is refused
            assert math.isfinite(value), (slider.key, typed)


def test_a_slider_in_decibels_is_linear_and_ends_at_the_bound_of_the_mission(draft):
    loss = slider_of(draft.set("communication.transmit_optics_loss", "0 dB"), "communication.transmit_optics_loss")
    assert (loss.scale, loss.low, loss.high, loss.at(0), loss.at(5)) == ("linear", 0.0, 10.0, "0 dB", "0.5 dB")
    level = slider_of(draft.set("beacon.required_power", "-80 dBm"), "beacon.required_power")
    assert (level.scale, level.at(0), level.at(level.steps)) == ("linear", "-90 dBm", "-70 dBm")


def test_a_slider_grows_for_a_value_outside_and_keeps_its_range_for_one_inside(draft):
    aperture = slider_of(draft, "terminals.leo_aperture")
    inside, outside = aperture.holding("7 cm"), aperture.holding("90 cm")
    assert (inside.low, inside.high, inside.value) == (aperture.low, aperture.high, 7.0)
    assert (outside.low, outside.high, outside.position) == (aperture.low, 90.0, outside.steps)
    other = aperture.holding("70 mm")
    assert (other.unit, other.at(other.position)) == ("mm", "70 mm")


@pytest.mark.parametrize("typed", ["largest", "", "5,2 cm", "5"])
def test_what_is_no_quantity_has_no_slider(draft, typed):
    rate = slider_of(draft, "communication.data_rate")
    assert rate.scale == "logarithmic"
    assert rate.holding(typed).scale == "none"


LENGTH, POWER, RATIO = Quantity("m", above=0.0, most=10.0), Quantity("W", least=0.0), Quantity("", least=-1.0, most=3.0)


def ranged(rule, typed, unit, value):
    return sliders._ranged(sliders.Slider("a.key", "Key", typed, rule, unit, "none", value))


@pytest.mark.parametrize(
    ("rule", "unit", "value", "scale", "low", "high"),
    [
        (LENGTH, "cm", 5.0, "logarithmic", 1.0, 20.0),  # 1.25 and 20, each to the next 1, 2 or 5 outwards
        (LENGTH, "cm", 6.0, "logarithmic", 1.0, 50.0),
        (LENGTH, "cm", 250.0, "logarithmic", 50.0, 1000.0),  # to the very bound
        (LENGTH, "cm", 251.0, "none", 0.0, 0.0),
        (LENGTH, "m", 1.5, "logarithmic", 0.2, 10.0),
        (LENGTH, "m", 0.0, "none", 0.0, 0.0),
        (Quantity("m", above=0.0, most=12.0), "m", 2.6, "logarithmic", 0.5, 12.0),
        (Quantity("m", above=1.0), "m", 3.0, "logarithmic", 1.0, 20.0),
        (Quantity("m", least=0.03), "cm", 5.0, "logarithmic", 3.0, 20.0),
        (POWER, "dBm", -80.0, "linear", -90.0, -70.0),
        (Quantity("W", least=1e-12), "dBm", -85.0, "linear", -90.0, -75.0),
        (Quantity("W", least=1e-12, most=1e-11), "dBW", -115.0, "linear", -120.0, -110.0),
        (RATIO, "", 0.0, "linear", -1.0, 3.0),
        (RATIO, "", -1.0, "linear", -1.0, 3.0),
        (RATIO, "", 0.5, "logarithmic", 0.1, 2.0),
        (RATIO, "", 0.8, "none", 0.0, 0.0),
        (Quantity("", least=-1.0), "", 0.0, "none", 0.0, 0.0),
        (Quantity("m", least=-1.0, most=3.0), "m", 0.0, "none", 0.0, 0.0),
        (RATIO, "", -2.0, "none", 0.0, 0.0),
        (Quantity("", most=3.0), "", 0.0, "none", 0.0, 0.0),
        (Quantity("", least=-3.0, most=0.0), "", 0.0, "linear", -3.0, 0.0),
        (Quantity("m", least=100.0), "m", 1.0, "none", 0.0, 0.0),  # below what the mission takes
        (Quantity("m", least=5.0), "m", 1.0, "none", 0.0, 0.0),
        (POWER, "W", 1.0, "logarithmic", 0.2, 5.0),
        (Share("", below=1.0), "", 0.25, "logarithmic", 0.05, 1.0),
        (Share("", below=1.0), "", 0.26, "none", 0.0, 0.0),
    ],
)
def test_a_slider_reaches_four_times_up_and_down_or_ten_decibels_within_its_bounds(rule, unit, value, scale, low, high):
    found = ranged(rule, f"{value:g} {unit}".strip(), unit, value)
    assert found.scale == scale
    assert (found.low, found.high) == pytest.approx((low, high), rel=1e-12)


@pytest.mark.parametrize(
    ("value", "down", "away"),
    [
        (1.0, 1.0, -1.0),
        (1.9, 1.0, -2.0),
        (2.0, 2.0, -2.0),
        (2.1, 2.0, -5.0),
        (0.049, 0.02, -0.05),
        (60.0, 50.0, -100.0),
    ],
)
def test_the_ends_of_a_slider_are_one_two_or_five_times_a_power_of_ten(value, down, away):
    assert sliders._round_down(value) == pytest.approx(down, rel=1e-12)
    assert sliders._round_down(-value) == pytest.approx(away, rel=1e-12)


@pytest.mark.parametrize(("span", "decimals"), [(20.0, 2), (1.0, 3), (100.0, 1), (1000.0, 0), (0.5, 4), (0.0, 2)])
def test_positions_of_a_linear_slider_are_told_apart(span, decimals):
    assert sliders._decimals(span) == decimals


def test_the_positions_of_a_slider_lie_evenly_on_its_scale_and_end_with_it():
    """A length from 1 to 20 cm by factors, a ratio from -1 to 3 by steps, a level from -90 to -70 dBm by 0.1 dB."""
    length, ratio = ranged(LENGTH, "5 cm", "cm", 5.0), ranged(RATIO, "0", "", 0.0)
    level = ranged(POWER, "-80 dBm", "dBm", -80.0)
    assert (length.steps, ratio.steps, level.steps) == (240, 240, 200)
    assert (length.position, ratio.position, level.position) == (round(240 * math.log(5, 20)), 60, 100)
    assert [length.at(p) for p in (-5, 0, 120, 240, 900)] == ["1 cm", "1 cm", "4.47 cm", "20 cm", "20 cm"]
    assert [ratio.at(p) for p in (0, 60, 120, 180, 240)] == ["-1", "0", "1", "2", "3"]
    assert [level.at(p) for p in (0, 1, 100, 200)] == ["-90 dBm", "-89.9 dBm", "-80 dBm", "-70 dBm"]
    exact = ranged(LENGTH, "5.037 cm", "cm", 5.037)
    assert exact.at(exact.position) == "5.037 cm" and exact.at(exact.position + 1) != "5.037 cm"
    narrow = ranged(Quantity("m", least=1.234, most=12.36), "3 m", "m", 3.0)
    assert (narrow.at(0), narrow.at(240)) == ("1.234 m", "12.36 m")  # rounded, they would lie outside
    assert replace(length, value=0.5).position == 0 and replace(length, value=30.0).position == 240
    assert replace(length, scale="none").position == 0


@pytest.mark.parametrize(
    ("typed", "scale", "low", "high"),
    [
        ("20 cm", "logarithmic", 1.0, 20.0),
        ("25 cm", "logarithmic", 1.0, 25.0),
        ("0.5 cm", "logarithmic", 0.5, 20.0),
        ("0 cm", "none", 1.0, 20.0),
        ("-1 cm", "none", 1.0, 20.0),
        ("80 mm", "logarithmic", 20.0, 500.0),
        ("5", "none", 1.0, 20.0),
    ],
)
def test_a_slider_that_holds_another_value_keeps_its_range_or_begins_anew(typed, scale, low, high):
    held = ranged(LENGTH, "5 cm", "cm", 5.0).holding(typed)
    assert (held.typed, held.scale) == (typed, scale)
    assert (held.low, held.high) == pytest.approx((low, high), rel=1e-12)


@pytest.mark.parametrize(("typed", "low", "high"), [("-0.5", -1.0, 3.0), ("-2", -2.0, 3.0), ("4", -1.0, 4.0)])
def test_a_linear_slider_holds_what_is_not_above_zero(typed, low, high):
    held = ranged(RATIO, "0", "", 0.0).holding(typed)
    assert (held.scale, held.value, held.low, held.high) == ("linear", float(typed), low, high)


@pytest.mark.parametrize(
    ("typed", "si", "found"),
    [
        ("5 cm", "m", (5.0, "cm")),
        (" -.5e1cm ", "m", (-5.0, "cm")),
        ("5", "", (5.0, "")),
        ("5", "m", None),
        ("5 cm", "", None),
        ("5 V", "m", None),
        ("1e999", "", None),
        ("1e999 m", "m", None),
        ("1e308 m", "m", (1e308, "m")),
        ("a", "", None),
    ],
)
def test_a_number_is_read_with_the_unit_of_its_kind(typed, si, found):
    assert sliders.read(typed, si) == found


def test_only_numbers_and_quantities_have_sliders(draft):
    unknown = draft.with_text(draft.text + "\n[more]\nx = 1\n")
    assert sliders.slider(unknown.values["more.x"]) is None
    for key in ("name", "conventions.strehl", "acquisition.attempts", "scenario.pid_frequencies", "orbit.epoch"):
        assert slider_of(draft, key) is None
    assert slider_of(draft, "beacon.strehl").rule.unit == ""
    word = slider_of(draft.set("communication.data_rate", "largest"), "communication.data_rate")
    assert (word.typed, word.scale, word.position, word.at(0)) == ("largest", "none", 0, "largest")


@pytest.mark.parametrize(
    ("rule", "unit", "low", "high"),
    [
        (LENGTH, "cm", 0.0, 1000.0),
        (LENGTH, "m", 0.0, 10.0),
        (LENGTH, "potatoes", 0.0, 10.0),
        (Quantity("m"), "cm", -math.inf, math.inf),
        (POWER, "dBm", -math.inf, math.inf),
        (Quantity("W", least=1e-3, most=1.0), "dBm", 0.0, 30.0),
        (Quantity("W", least=1e-3, most=1.0), "dBW", -30.0, 0.0),
        (Share("", below=1.0), "", -math.inf, 1.0),
    ],
)
def test_the_bounds_of_a_slider_are_those_of_the_mission_in_its_unit(rule, unit, low, high):
    assert sliders._bounds(rule, unit) == (pytest.approx(low, abs=1e-12), pytest.approx(high, abs=1e-12))


def test_a_slider_in_decibels_has_a_position_at_least():
    narrow = ranged(Quantity("dB", least=0.0, most=0.01), "0 dB", "dB", 0.0)
    assert (narrow.scale, narrow.steps, narrow.position) == ("linear", 1, 0)


@pytest.mark.parametrize(
    ("key", "label"),
    [
        ("terminals.leo_aperture", "LEO aperture"),
        ("terminals.aperture_of_geo", "Aperture of GEO"),
        ("communication.data_rate", "Data rate"),
        ("confidence", "Confidence"),
    ],
)
def test_a_key_is_called_by_its_words(key, label):
    assert sliders.label(key) == label


def test_a_share_near_one_has_no_slider_and_a_small_one_does_not_reach_one(draft):
    assert slider_of(draft, "pointing.confidence").scale == "none"
    outage = slider_of(draft, "requirement.outage")
    assert outage.scale == "logarithmic"
    assert float(outage.at(outage.steps)) < 1.0


def test_a_fault_is_told_beside_its_slider_in_the_words_of_the_command_line(draft):
    wrong = draft.set("terminals.leo_aperture", "5")
    told = sliders.faulty(wrong, ["terminals.leo_aperture", "terminals.geo_aperture"])
    assert [*told] == ["terminals.leo_aperture"]
    assert "without a unit" in told["terminals.leo_aperture"]
    assert "a length with its unit" in told["terminals.leo_aperture"]
    assert wrong.problems[0].reason in told["terminals.leo_aperture"]
    assert sliders.faulty(draft, ["terminals.leo_aperture"]) == {}


# ------------------------------------------------------------------------------------------------------------ attempts
@pytest.mark.promise("readme-15")
@pytest.mark.promise("studio-12")
def test_an_attempt_is_the_study_of_the_changed_file_and_leaves_the_draft(draft):
    found = sliders.attempt(draft, "terminals.leo_aperture", "6 cm", link_view.view)
    margin = found.view.margins[0]
    alone = link_study.run_link_study(draft.set("terminals.leo_aperture", "6 cm").link())
    assert margin.margin_db == alone.communication.margin_db
    assert margin.margin_db > link_view.view(draft.link()).margins[0].margin_db + 0.5
    assert draft.values["terminals.leo_aperture"].typed == "5 cm"


def test_an_attempt_with_a_fault_has_no_view_and_one_that_cannot_be_budgeted_says_why(draft):
    wrong = sliders.attempt(draft, "terminals.leo_aperture", "5 W", link_view.view)
    assert wrong.view is None
    assert wrong.refusal == ""
    assert wrong.draft.problems
    hopeless = draft.set("communication.data_rate", "largest").set("communication.transmit_power", "1 pW")
    refused = sliders.attempt(hopeless, "requirement.margin", "300 dB", link_view.view)
    assert refused.view is None
    assert "not even" in refused.refusal
    assert not refused.draft.problems


# --------------------------------------------------------------------------------------------------------------- links
@pytest.mark.promise("readme-15")
@pytest.mark.promise("studio-12")
def test_the_map_is_the_margin_of_the_link_and_its_contour_has_the_margin_that_it_names(view):
    frame = view.frame
    assert np.array_equal(view.margin_db, link.margin_map(view.data, frame.data_rate_bit_s, frame.pointing_error_rad))
    for level, rates in view.contours.items():
        there = np.isfinite(rates)
        assert there.any()
        errors = frame.pointing_error_rad[there]
        found = [
            link.margin_map(view.data, rate, error)[0, 0] for rate, error in zip(rates[there], errors, strict=True)
        ]
        assert np.allclose(found, level, atol=1e-6)
        outside = link.margin_map(view.data, frame.data_rate_bit_s[[0, -1]], frame.pointing_error_rad[~there])
        assert np.all((outside[0] < level) | (outside[1] > level))


def test_the_required_contour_goes_through_the_largest_rate(view):
    required = view.data.requirement
    rates = view.contours[required.margin_db]
    at = np.interp(required.pointing_error_rad, view.frame.pointing_error_rad, np.log(rates))
    assert np.exp(at) == pytest.approx(link_study.largest_rate(view.data), rel=2e-3)


@pytest.mark.parametrize("name", sorted(RECEIVERS))
def test_the_contour_of_a_built_receiver_has_its_margin(tmp_path, name):
    found = link_view.view(link_file(tmp_path, received_with(name)))
    frame = found.frame
    for level, rates in found.contours.items():
        for place in np.flatnonzero(np.isfinite(rates))[:3]:
            margin = link.margin_map(found.data, rates[place], frame.pointing_error_rad[place])[0, 0]
            assert margin == pytest.approx(level, abs=2e-3)
    assert frame.data_rate_bit_s[-1] <= found.data.receiver.highest_data_rate_bit_s


@pytest.mark.promise("link-5")
def test_under_a_jitter_the_page_has_the_margin_of_the_outage(tmp_path):
    """As the budget of the command line, whatever the static pointing error is."""
    shaken = {"jitter": {"bias": ["0 urad", "0 urad"], "rms": ["4 urad", "4 urad"], "bandwidth": "50 Hz"}}
    file = link_file(tmp_path, shaken)
    still, found = (link_view.view(each) for each in (link_file(tmp_path), file))
    error = 4e-6 * math.sqrt(-2.0 * math.log(found.data.requirement.outage))  # Rayleigh
    there = link.communication_budget(still.data, {}, pointing_error_rad=error).margin_db
    margin, needed = found.margins[0].margin_db, found.margins[0].required_db
    assert margin == found.budgets[0].margin_db == pytest.approx(under_jitter.margin_db(found.data), abs=1e-12)
    assert margin == pytest.approx(there, abs=1e-6)
    assert (still.margins[0].met, found.margins[0].met) == (True, False)
    assert still.margins[0].margin_db == pytest.approx(needed, abs=1e-3) and margin < needed - 0.5
    assert f"{error * 1e6:.2f}" in link_view.map_words(found) and "10 \u00b5rad" in link_view.map_words(still)
    assert link.margin_map(found.data, found.data.table.data_rate_bit_s, error)[0, 0] == pytest.approx(margin, abs=1e-6)
    assert found.frame.pointing_error_rad[-1] > error
    jittered, calm = (link_view.blocks(link_study.run_link_study(each)) for each in (file, link_file(tmp_path)))
    assert "What pointing costs the link" in [each.title for each in jittered if isinstance(each, View)]
    assert "What pointing costs the link" not in [each.title for each in calm if isinstance(each, View)]


def test_the_frame_stands_still_until_the_working_point_leaves_it(draft, view):
    near = link_view.view(draft.set("communication.data_rate", "500 Mbit/s").link(), view.frame)
    far = link_view.view(draft.set("communication.data_rate", "90 Gbit/s").link(), view.frame)
    assert near.frame is view.frame
    assert far.frame is not view.frame
    assert far.frame.data_rate_bit_s[0] < 90e9 < far.frame.data_rate_bit_s[-1]


def test_a_working_point_at_the_very_edge_of_the_frame_lies_within(view):
    rate, error = view.data.table.data_rate_bit_s, view.data.requirement.pointing_error_rad
    for rates, most, within in (
        ((rate, 2.0 * rate), error, True),
        ((0.5 * rate, rate), error, True),
        ((1.001 * rate, 2.0 * rate), error, False),
        ((0.5 * rate, 0.999 * rate), error, False),
        ((0.5 * rate, 2.0 * rate), 0.999 * error, False),
    ):
        assert link_view.Frame(np.array(rates), np.array([0.0, most])).holds(view.data) is within
    strict = replace(
        view.data, requirement=view.data.requirement.model_copy(update={"pointing_error_rad": 2.0 * error})
    )
    assert not link_view.Frame(np.array([rate, rate]), np.array([0.0, 1.5 * error])).holds(strict)
    assert link_view.Frame(np.array([rate, rate]), np.array([0.0, 2.0 * error])).holds(strict)


def test_the_frame_moves_for_a_required_error_beyond_it(draft, view):
    beyond_rad = 3.0 * view.frame.pointing_error_rad[-1]
    strict = link_view.view(draft.set("requirement.pointing_error", f"{1e6 * beyond_rad:.9g} urad").link(), view.frame)
    assert strict.frame.pointing_error_rad[-1] >= strict.data.requirement.pointing_error_rad > beyond_rad * (1 - 1e-8)
    same = draft.set("requirement.pointing_error", f"{1e6 * view.frame.pointing_error_rad[-2]:.9g} urad")
    assert link_view.view(same.link(), view.frame).frame is view.frame


def test_margins_say_whether_they_are_met(draft):
    names = [(m.name, m.required_db, m.met) for m in link_view.view(draft.link()).margins]
    assert names == [("Communication", 3.0, True), ("Beacon", 0.0, True), ("Answer", 0.0, True)]
    short = link_view.view(draft.set("terminals.leo_aperture", "4 cm").link()).margins[0]
    assert not short.met
    assert "needs 3 dB: MISSED" in short.needs


def test_the_last_rows_of_a_table_stand_out_and_nothing_is_sent_twice():
    made = SimpleNamespace(rows=[])
    elements.fill(made, [("a", "1"), ("sum", "1")], totals=1)
    assert made.rows == [
        {"id": 0, "total": False, "c0": "a", "c1": "1"},
        {"id": 1, "total": True, "c0": "sum", "c1": "1"},
    ]
    before = made.rows
    elements.fill(made, [("a", "1"), ("sum", "1")], totals=1)
    assert made.rows is before


def lines(figure):
    """What the legend of a figure names: curves and straight lines."""
    return [each for each in (*figure["data"], *figure["layout"]["shapes"]) if each.get("showlegend")]


def test_the_plots_are_plain_data_with_units_on_their_axes(view, draft, figures):
    pointed = pointing_view.view(draft.link())
    drawn = {
        "map": link_view.map_plot(view),
        "lines": pointing_view.lines_plot(pointed),
        "coverage": pointing_view.coverage_plot(pointed),
        "timeline": plots.figure(figures["day-timeline"].sheet),
        "volume": plots.figure(figures["data-volume"].sheet),
    }
    units = {"map": "µrad", "lines": "µrad", "coverage": "µrad", "timeline": "hours", "volume": "GB"}
    for name, figure in drawn.items():
        json.dumps(figure, allow_nan=False)
        titles = [figure["layout"][axis]["title"]["text"] for axis in ("xaxis", "yaxis")]
        assert any(units[name] in title for title in titles), name
        assert figure["config"]["displaylogo"] is False
    assert "300 Mbit/s" in link_view.map_words(view)
    assert drawn["map"]["layout"]["xaxis"]["title"]["text"] == "data rate (Mbit/s)"
    assert drawn["map"]["data"][0]["z"][0][0] == pytest.approx(view.margin_db[0, 0], abs=0.006)


def test_the_words_of_the_map_name_both_ways_out_and_that_there_is_none(draft, view, monkeypatch):
    assert link_view.map_words(view).startswith("At 300 Mbit/s and 10 µrad the communication link has +3.43 dB.")
    dark = link_view.view(draft.set("communication.transmit_power", "10 mW").link())
    assert "no pointing error at 300 Mbit/s" in link_view.map_words(dark)
    assert "At most " in link_view.map_words(dark)
    monkeypatch.setattr(link_study, "largest_rate", lambda data: math.nan)
    assert "No data rate will do at 10 µrad, or " in link_view.map_words(view)
    assert "No data rate will do at 10 µrad, and no pointing error at 300 Mbit/s, for" in link_view.map_words(dark)


def test_sliders_are_those_of_the_links_and_the_seldom_moved_stand_behind(draft):
    found = link_view.sliders(draft)
    assert [*found] == ["Telescopes", "Communication", "Beacon", "Answer", "Required"]
    keys = [slider.key for group in found.values() for slider in group]
    assert "fine_pointing.body.error" not in keys
    assert next(key for key in keys if link_view.second(key)) == "communication.wavelength"
    assert not link_view.second("terminals.leo_aperture")


@pytest.mark.promise("studio-12")
def test_the_study_of_the_links_gives_tables_sentences_and_what_moves_the_margin(draft):
    study = link_study.run_link_study(draft.link())
    blocks = link_view.blocks(study)
    drawn, first = plots.drawn(blocks)["tornado"], study.tornados[0].swings[0]
    assert drawn["layout"]["yaxis"]["ticktext"][0].startswith(first.key.removeprefix("communication."))
    bars = [bar for each in drawn["data"] for bar in zip(each["y"], each["base"], each["x"], strict=True)]
    ends = [base + length for row, base, length in bars if row == 0]
    assert sorted(ends) == pytest.approx(sorted((first.margin_low_db, first.margin_high_db)), rel=1e-4)
    assert "The answer's light on the tracking sensor" in [each.title for each in blocks if isinstance(each, Table)]
    assert blocks[0].startswith("The links close")
    titles = [each.title for each in blocks if isinstance(each, View)]
    assert "Acquisition" in titles and "Open-loop pointing" not in titles
    marked = "Marked \u201c!\u201d in the tables:"
    far = link_view.blocks(link_study.run_link_study(draft.set("communication.pointing_error", "60 urad").link()))
    assert (marked in blocks, marked in far) == (False, True)


def test_the_links_show_a_code_under_the_fades_of_a_series_beside_the_draft(tmp_path):
    path = tmp_path / "mission.toml"
    path.write_text(Draft.shipped(path).text + FADING, encoding="utf-8")
    faded = Draft.open(path)
    with pytest.raises(FadeSeriesError, match=r"line \d+: .*fades\.csv: there is no such file"):
        link_study.run_link_study(faded.link())
    power = 1.0 + 0.5 * np.sin(np.arange(2000) / 40.0)
    np.savetxt(tmp_path / "fades.csv", power, header="power", comments="")
    blocks = link_view.blocks(link_study.run_link_study(faded.link()))
    views = {each.title: each for each in blocks if isinstance(each, View)}
    assert "Under the fades of fades.csv" in views["Coded link under fades"].blocks[0]


# ------------------------------------------------------------------------------------------------------------ pointing
@pytest.mark.promise("studio-12")
def test_what_is_left_for_a_line_meets_the_beacon_by_either_rule(draft):
    wide = draft.set("beacon.divergence", "2000 urad")
    rows = pointing_view.blocks(pointing_view.view(wide.link()))[0].rows
    body = {rule: float(rows[0][k].removesuffix(" \u00b5rad")) for k, rule in ((3, "rss"), (4, "ecss-radial"))}
    assert body["rss"] > body["ecss-radial"] > 0.0
    for rule, largest in body.items():
        again = wide.set("pointing.lines.body_pointing.error", f"{largest:.9f} urad").link()
        met = pointing_view.view(again)
        assert met.budget.total_rad(rule) == pytest.approx(met.half_angle_rad, rel=3e-3)  # of three digits


@pytest.mark.promise("readme-15")
def test_the_tables_of_the_shipped_mission_say_what_its_beacon_covers(draft):
    lines, note, shown, said, ahead = pointing_view.blocks(pointing_view.view(draft.link()))
    assert lines.headings[3:5] == ("largest allowed", "largest allowed,\nECSS")
    assert [row[4] for row in lines.rows] == ["249 \u00b5rad", "nothing", "66.6 \u00b5rad", "nothing"]
    assert "ECSS for two axes" in note.text
    totals = {row[0]: row for row in shown.rows}
    assert totals["root sum square"][1:3] == ("317.1 \u00b5rad", "covers it, 72.9 \u00b5rad left")
    assert "means add linearly" in totals["root sum square"][-1]
    assert totals["ECSS, two axes"][2].endswith("short")
    assert "0.9822" in said
    assert ahead.blocks[0].startswith("Point-ahead: up to 71 \u00b5rad")


def test_without_beacon_and_point_ahead_the_page_says_so(tmp_path):
    gone = dict.fromkeys(("beacon", "answer", "acquisition", "point_ahead"))
    bare = link_file(tmp_path, {key: None for key in gone if key in data_with({})})
    found = pointing_view.view(bare)
    said, errors, totals, ahead = pointing_view.blocks(found)
    assert said == "The mission has no beacon, so nothing is to be covered."
    assert ahead.blocks == [Soft("The mission has no table [point_ahead].")]
    assert not any("beacon" in heading or "allowed" in heading for heading in (*errors.headings, *totals.headings))
    names = [line["name"] for line in lines(pointing_view.coverage_plot(found))]
    assert names[0] == "inside this angle"
    assert not any("beacon" in name for name in names)
    drawn = pointing_view.lines_plot(found)
    assert not any("beacon" in shape.get("name", "") for shape in drawn["layout"]["shapes"])
    assert math.isnan(found.half_angle_rad)
    assert len(link_view.view(bare).margins) == 1


def test_the_angles_go_beyond_the_widest_of_totals_and_beacon(draft):
    for divergence, name in (("2000 urad", "beacon"), ("100 urad", "ECSS, two axes")):
        shown = pointing_view.coverage_plot(pointing_view.view(draft.set("beacon.divergence", divergence).link()))
        ends = {shape["name"]: shape["x0"] for shape in shown["layout"]["shapes"] if shape.get("name")}
        widest = max(ends, key=ends.get)
        assert widest.startswith(name)
        assert shown["data"][0]["x"][-1] == pytest.approx(1.25 * ends[widest], rel=1e-3)


def test_a_line_without_a_width_is_drawn_all_the_same(draft):
    """Nothing is to be covered, and still there is an axis."""
    found = pointing_view.view(draft.link())
    nothing = SimpleNamespace(total_rad=lambda rule: 0.0, coverage=np.ones_like, confidence=0.997, reading=None)
    shown = pointing_view.coverage_plot(replace(found, budget=nothing))
    assert shown["data"][0]["x"][-1] == pytest.approx(1.0)
    endless = SimpleNamespace(**{**vars(nothing), "total_rad": lambda rule: math.inf if rule == "exact" else 1e-4})
    assert pointing_view.coverage_plot(replace(found, budget=endless))["data"][0]["x"][-1] == pytest.approx(125.0)


@pytest.mark.promise("studio-12")
def test_the_curve_of_coverage_is_the_budget_s(draft):
    found = pointing_view.view(draft.link())
    curve = pointing_view.coverage_plot(found)["data"][0]
    radius = np.array(curve["x"]) * 1e-6
    assert np.allclose(np.array(curve["y"]) / 100.0, found.budget.coverage(radius), atol=1e-4)  # five digits
    assert curve["y"][0] == 0.0
    assert curve["y"][-1] > 99.0


def test_the_working_point_stands_at_rate_and_error_of_the_mission(view):
    (point,) = (each for each in link_view.map_plot(view)["data"] if each.get("name") == "working point")
    assert (point["x"], point["y"]) == ([300.0], [10.0])  # Mbit/s and µrad of the shipped mission


def test_each_rule_stands_at_the_angle_that_its_label_says(draft):
    shapes = pointing_view.coverage_plot(pointing_view.view(draft.link()))["layout"]["shapes"]
    told = [(shape["x0"], re.search(r": ([\d.]+) µrad$", shape["name"])) for shape in shapes if shape.get("name")]
    assert len(told) == 4  # the beacon and three rules of summation
    for at, words in told:
        assert at == pytest.approx(float(words[1]), rel=5e-3)


# ----------------------------------------------------------------------------------------------------------------- day
@pytest.mark.promise("studio-12")
def test_the_timeline_has_every_contact_of_either_way(day, figures):
    shown = figures["day-timeline"]
    begins, ends = shown.columns["relay, start (s)"], shown.columns["relay, end (s)"]
    assert {name.partition(",")[0] for name in shown.columns} == {"relay", "direct: kiruna", "eclipse of LEO"}
    assert len(begins) == len(day.relay.contacts)
    assert float(np.sum(ends - begins)) == pytest.approx(day.relay.contact_s, rel=1e-9)
    bars = plots.figure(shown.sheet)["data"][1]
    assert bars["base"][0] == pytest.approx(day.direct.contacts[0].start_s / 3600.0, rel=1e-5)


@pytest.mark.promise("studio-12", "studio-13", "studio-30")
def test_the_map_is_that_of_the_report_and_loads_nothing(day, figures):
    shown = plots.drawn(day_view.blocks(day))
    kind, _, data = shown["world-map"].partition(",")
    drawn = base64.b64decode(data, validate=True).decode()
    assert kind == "data:image/svg+xml;base64"
    assert drawn == day_plots.ground_map(day).svg
    assert drawn.startswith("<svg ")
    assert 'xmlns="http://www.w3.org/2000/svg"' in drawn
    assert not re.search(r'(?:href="|url\()(?!#)', drawn)
    assert figures["world-map"].caption.startswith("Ground track of the satellite, thick where it is in contact.")
    assert shown.keys() == figures.keys()
    assert not any(isinstance(each, str) for name, each in shown.items() if name != "world-map")


@pytest.mark.promise("studio-12")
def test_volumes_end_where_the_ways_do(day, figures):
    drawn = plots.figure(figures["data-volume"].sheet)["data"]
    names = "made by the instrument", "relay", "direct downlink"
    assert tuple(trace["name"] for trace in drawn) == (*names, *names[1:])
    assert drawn[1]["y"][-1] == pytest.approx(day.relay.history.delivered_bit[-1] / 8e9, rel=1e-4)
    assert max(drawn[4]["y"]) == pytest.approx(day.direct.history.largest_stored_bit / 8e9, rel=0.05)


@pytest.mark.promise("studio-12")
def test_latencies_rise_to_what_arrives_and_pass_their_median(day, figures):
    shown = figures["latency"].columns
    time_s, share = shown["relay, latency (s)"], shown["relay, share"]
    assert np.all(np.diff(time_s) > 0.0)
    assert np.all(np.diff(share) >= -1e-12)
    before, behind = np.interp(day.relay.median_s * (1.0 + np.array([-1e-6, 1e-6])), time_s, share)
    assert before < 0.5 < behind  # at once, in one step, comes what is made in sight of the relay
    assert share[-1] == pytest.approx(1.0)


@pytest.mark.promise("readme-15")
@pytest.mark.promise("studio-12")
def test_the_blocks_of_the_day_have_its_numbers_and_warnings(day):
    blocks = day_view.blocks(day)
    ways, contacts, swings = (each for each in blocks if isinstance(each, Table))
    assert ways.rows[0] == ("contacts", str(len(day.relay.contacts)), str(len(day.direct.contacts)))
    assert len(contacts.rows) == len(day.relay.contacts) + len(day.direct.contacts)
    assert len(contacts.headings) == len(contacts.rows[0])
    assert len(swings.rows) >= len(day.swings)
    warned = blocks[blocks.index("Warnings:") + 1].lines
    assert warned == day.warnings
    assert warned[-1].startswith("communication.distance")


def test_a_mission_without_orbits_says_what_is_missing(draft, tmp_path):
    gone = ("orbit", "operations", "constellation")
    bare = link_file(tmp_path, {key: None for key in gone if key in data_with({})})
    assert "no [orbit] and no [operations]" in day_view.missing(bare)
    assert day_view.missing(draft.link()) == ""


# --------------------------------------------------------------------------------------------------------------- plots
def test_a_name_in_a_plot_is_no_markup():
    at = np.array([0.0, 1.0])
    drawn = plots.plot(
        Axis("<b>x</b>"), Axis("y"), Line(at, at, label="<img src=//evil>"), Rule(0.5, True, label="<i>r")
    )
    assert drawn["layout"]["xaxis"]["title"]["text"] == "&lt;b&gt;x&lt;/b&gt;"
    assert [line["name"] for line in lines(drawn)] == ["&lt;img src=//evil&gt;", "&lt;i&gt;r"]
    assert plots.empty("<b>")["layout"]["annotations"][0]["text"] == "&lt;b&gt;"


def test_a_sheet_without_panels_says_its_heading():
    assert plots.figure(Sheet(6.0, 4.0, heading="no rows")) == plots.empty("no rows")


def test_panels_of_a_sheet_stand_where_the_sheet_has_them():
    at = np.array([0.0, 1.0])
    sheet, (above, below) = grid(6.0, 4.0, 2, share_x=True)
    above.add(Line(at, at))
    below.add(Line(at, at))
    layout = plots.figure(sheet)["layout"]
    assert layout["yaxis"]["domain"][1] == layout["xaxis"]["domain"][1] == 1.0
    assert layout["yaxis2"]["domain"][0] == 0.0
    assert 0.3 < layout["yaxis2"]["domain"][1] < layout["yaxis"]["domain"][0] < 0.7
    assert layout["xaxis"]["domain"] == layout["xaxis2"]["domain"]


def test_the_legend_names_each_curve_once_and_what_is_not_drawn():
    at = np.array([0.0, 1.0])
    alike = Line(at, at, label="a"), Line(at, 2.0 * at, label="a")
    drawn = plots.plot(
        Axis("x"), Axis("y"), *alike, Line(at[:0], at[:0], "#D55E00", "--", label="far"), Line(at, at, "#0072B2")
    )
    assert [(each.get("name"), each["showlegend"]) for each in drawn["data"]] == [
        ("a", True),
        ("a", False),
        ("", False),
        ("far", True),
    ]
    assert drawn["data"][-1]["x"] == [None]


# -------------------------------------------------------------------------------------------------------------- latest
def test_the_latest_question_is_answered_once_and_kept():
    latest, calls = Latest(), []

    def work(progress):
        progress(1, 2, "half")
        calls.append(1)
        return 42

    latest.ask("a", work)
    assert latest.wait(HANG_S).result == 42
    latest.ask("a", work)
    state = latest.wait(HANG_S)
    assert (len(calls), state.done, state.total, state.what, state.running) == (1, 1, 2, "half", False)


def test_an_older_question_is_dropped_for_a_newer_one():
    latest, begun, go, ended = Latest(), threading.Event(), threading.Event(), []

    def slow(progress):
        begun.set()
        go.wait(HANG_S)
        progress(1, 2, "late")
        ended.append("slow")
        return "slow"

    latest.ask("a", slow)
    assert begun.wait(HANG_S)
    first = latest._thread
    latest.ask("b", lambda progress: "quick")
    assert latest.wait(HANG_S).result == "quick"
    go.set()
    first.join(HANG_S)
    assert ended == []
    assert latest.state.result == "quick"


def test_a_cancelled_question_can_be_asked_again_and_an_error_is_kept():
    latest, go = Latest(), threading.Event()
    latest.ask("a", lambda progress: (go.wait(HANG_S), progress(0, 0, ""))[0])
    latest.cancel()
    go.set()
    assert latest.state.key == ""
    assert not latest.state.running

    def refuse(progress):
        raise day_study.flow.operations.OperationsError("no day; give it an orbit")

    latest.ask("a", refuse)
    state = latest.wait(HANG_S)
    assert (state.error, state.result, state.running) == ("no day; give it an orbit", None, False)
    latest.ask("a", lambda progress: 7)  # it is answered already
    assert latest.wait(HANG_S).error == "no day; give it an orbit"
    latest.cancel()  # nothing is running
    assert latest.state.key == "a"
    latest.ask("b", lambda progress: 0)
    assert latest.wait(HANG_S).result == 0
    latest.ask("b", lambda progress: 1)  # nothing is a result, too
    assert latest.wait(HANG_S).result == 0
    latest.ask("c", lambda progress: None)
    assert not latest.wait(HANG_S).running
    latest.ask("c", lambda progress: 3)
    assert latest.wait(HANG_S).result == 3


def test_a_question_that_is_being_worked_on_is_not_begun_again():
    latest, go = Latest(), threading.Event()
    latest.ask("a", lambda progress: (go.wait(HANG_S), 1)[1])
    first = latest._thread
    latest.ask("a", lambda progress: 2)
    assert latest._thread is first and latest.state.running
    go.set()
    assert latest.wait(HANG_S).result == 1


def test_a_question_that_the_memory_does_not_suffice_for_says_so():
    def large(progress):
        raise MemoryError

    latest = Latest()
    latest.ask("a", large)
    assert latest.wait(HANG_S).error == "the memory does not suffice; make the mission smaller"
    assert not latest.state.running


def test_what_pages_share_belongs_to_its_owner():
    class Owner:
        pass

    one, two = Owner(), Owner()
    assert shared(one, "day") is shared(one, "day")
    assert shared(one, "day") is not shared(two, "day")
    assert shared(one, "day") is not shared(one, "links")


def test_nothing_of_this_needs_a_browser():
    folder = Path(link_view.__file__).parent
    texts = [path.read_text("utf-8") for path in folder.glob("*.py")]
    assert len(texts) > 10
    assert not any("nicegui" in text for text in texts)


# ------------------------------------------------------------------------------------------ numbers unlike each other
UNLIKE = {
    "communication.data_rate": "622.08 Mbit/s",
    "communication.pointing_error": "7.3 urad",
    "requirement.pointing_error": "4.1 urad",
    "requirement.margin": "1.7 dB",
}


def unlike(draft, **more):
    """The mission with numbers that have digits, in place of those that are alike."""
    for key, typed in (UNLIKE | more).items():
        draft = draft.set(key, typed)
    return draft


def test_the_axes_of_a_map_reach_a_decade_about_the_rate_and_three_times_the_larger_error(draft):
    found = link_view.view(unlike(draft).link())
    frame = found.frame
    assert frame.data_rate_bit_s[[0, -1]] == pytest.approx([1e7, 1e10], rel=1e-9)
    assert frame.pointing_error_rad[[0, -1]] == pytest.approx([0.0, 21.9e-6], rel=1e-9)
    assert (frame.data_rate_bit_s.size, frame.pointing_error_rad.size, found.margin_db.shape) == (65, 61, (65, 61))
    strict = unlike(draft, **{"requirement.pointing_error": "9.2 urad", "communication.data_rate": "1.5 Gbit/s"})
    other = link_view.view(strict.link()).frame
    assert other.data_rate_bit_s[[0, -1]] == pytest.approx([1e8, 1e11], rel=1e-9)
    assert other.pointing_error_rad[-1] == pytest.approx(27.6e-6, rel=1e-9)


def test_the_map_has_the_working_point_both_contours_and_the_margins_of_each_place(draft):
    found = link_view.view(unlike(draft).link())
    figure = link_view.map_plot(found)
    heat, *drawn = figure["data"]
    by_name = {each["name"]: each for each in drawn}
    assert [*by_name] == ["0 dB", "1.7 dB", "working point"]
    assert [by_name[name]["line"]["dash"] for name in ("0 dB", "1.7 dB")] == ["dash", "solid"]
    assert by_name["0 dB"]["line"]["width"] < by_name["1.7 dB"]["line"]["width"]
    assert (by_name["working point"]["x"], by_name["working point"]["y"]) == ([622.08], [7.3])
    x_axis, y_axis = figure["layout"]["xaxis"], figure["layout"]["yaxis"]
    assert (x_axis["range"], y_axis["range"]) == ([1, 4], pytest.approx([0.0, 21.9]))
    assert (heat["zmin"], heat["zmax"]) == (-12, 18)
    assert len(heat["z"]) == 61 and len(heat["z"][0]) == 65
    assert heat["z"][60][3] == pytest.approx(found.margin_db[3, 60], abs=0.006)
    level = np.interp(7.3, by_name["1.7 dB"]["y"], by_name["1.7 dB"]["x"])
    at = np.interp(7.3e-6, found.frame.pointing_error_rad, found.contours[1.7])
    assert level == pytest.approx(at * 1e-6, rel=1e-3)


def test_a_mission_whose_required_margin_is_zero_has_one_contour(draft):
    found = link_view.view(draft.set("requirement.margin", "0 dB").link())
    assert [*found.contours] == [0.0]
    names = [each["name"] for each in link_view.map_plot(found)["data"] if each.get("name")]
    assert names == ["0 dB", "working point"]


def test_the_map_in_words_has_the_rate_with_its_digits_and_both_ways_out(draft):
    found = link_view.view(unlike(draft).link())
    words = link_view.map_words(found)
    fastest = link_study.largest_rate(found.data)
    error = link.largest_pointing_error(found.data, 1.7, 622.08e6)
    assert words == (
        "At 622.1 Mbit/s and 7.3 µrad the communication link has "
        f"{link_view.signed(found.budgets[0].margin_db, 'dB')}. At most {link_view.quantity(fastest, 'bit/s')} at "
        f"4.1 µrad, or {link_view.quantity(error, 'rad')} at 622.1 Mbit/s, for the required 1.7 dB."
    )


def test_a_margin_below_zero_is_missed_by_its_sign_and_needs_its_digits():
    margin = link_view.Margin("a", -0.125, -0.25)
    assert (margin.met, margin.words, margin.needs) == (True, "\u22120.12 dB", "needs -0.25 dB: met")
    assert link_view.Margin("a", 1.69, 1.7, True, "†").words == "+1.69 dB †"
    assert link_view.Margin("a", 1.69, 1.7).needs == "needs 1.7 dB: MISSED"


@pytest.mark.parametrize(
    ("key", "seldom"),
    [
        ("terminals.leo_obscuration", True),
        ("beacon.wavefront_error", True),
        ("requirement.outage", True),
        ("answer.strehl", True),
        ("beacon.strehl_of_mine", False),
        ("communication.loss", False),
        ("communication.pointing_error", False),
    ],
)
def test_what_is_seldom_moved_ends_like_it(key, seldom):
    assert link_view.second(key) is seldom


def test_the_bars_of_the_lines_have_their_rows_their_class_and_the_totals_below(draft):
    found = pointing_view.view(draft.link())
    figure = pointing_view.lines_plot(found)
    rows = [(each.name, each.kind, each.error_rad) for each in found.budget.stated]
    totals = [(each.name, "total", each.total_rad) for each in found.budget.summations]
    bars = {each["name"]: each for each in figure["data"]}
    assert [*bars] == [*dict.fromkeys(kind for _, kind, _ in (*rows, *totals))]
    for kind, bar in bars.items():
        own = [(k, 1e6 * error) for k, (_, of, error) in enumerate((*rows, *totals)) if of == kind]
        assert bar["y"] == [k for k, _ in own]
        assert bar["x"] == pytest.approx([error for _, error in own], rel=1e-4)
        assert set(bar["base"]) == {0}
    assert figure["layout"]["yaxis"]["ticktext"] == [name for name, *_ in (*rows, *totals)]
    (rule,) = [shape for shape in figure["layout"]["shapes"] if shape.get("name")]
    assert (rule["name"], rule["x0"]) == ("beacon's half angle: 390 µrad", 390)


@pytest.mark.parametrize(
    ("key", "group"),
    [
        ("pointing.lines.body_pointing.error", "Errors"),
        ("pointing.lines.body_pointing.kind", ""),
        ("pointing.lines_of_mine.a.error", ""),
        ("error_budget.sources.a-b.size", "Sources"),
        ("error_budget.sources.a-b.rate", "Sources"),
        ("error_budget.sources.a-b.limit", ""),
        ("error_budget.requirements.a.limit", "Limits"),
        ("error_budget.requirements.a.size", ""),
        ("beacon.divergence", "Beacon"),
        ("answer.divergence", ""),
        ("point_ahead.error", "Point-ahead"),
        ("pointing.confidence", "Asked for"),
    ],
)
def test_what_moves_the_budget_stands_in_its_group(key, group):
    assert pointing_view._group(key) == group


@pytest.mark.parametrize(
    ("key", "label"),
    [
        ("pointing.lines.star_tracker_x.error", "Star tracker x"),
        ("error_budget.sources.thermo-elastic_drift.rate", "Thermo elastic drift"),
        ("error_budget.requirements.code_word.limit", "Code word"),
    ],
)
def test_a_slider_of_the_budget_is_called_by_its_line(key, label):
    made = sliders.Slider(key, "Error", "1 urad", LENGTH)
    assert pointing_view._named(made) == replace(made, label=label)


def test_two_faults_of_a_key_are_told_beside_its_slider_and_those_of_its_neighbour_are_not(draft):
    one, two = (SimpleNamespace(key="a.b", reason=f"reason {n}", expected=f"wanted {n}") for n in (1, 2))
    other = SimpleNamespace(key="a.bc", reason="reason 3", expected="wanted 3")
    wrong = SimpleNamespace(problems=(one, other, two))
    assert sliders.faulty(wrong, ["x.y", "a.bc", "a.b"]) == {
        "a.bc": "reason 3; expected wanted 3",
        "a.b": "reason 1; expected wanted 1; reason 2; expected wanted 2",
    }


@pytest.mark.parametrize(
    ("typed", "position", "text"),
    [("2.5 cm", 0, "0.5 cm"), ("2.5 cm", 60, "1.06 cm"), ("2.5 cm", 200, "6.07 cm"), ("2.5 cm", 239, "9.88 cm")],
)
def test_a_position_between_the_ends_is_a_value_of_three_digits(typed, position, text):
    made = ranged(LENGTH, typed, "cm", 2.5)
    assert (made.low, made.high) == (0.5, 10.0)
    wanted = 0.5 * 20.0 ** (position / 240.0)
    assert text == f"{float(f'{wanted:.3g}'):g} cm"
    assert made.at(position) == text


def test_a_slider_that_held_no_quantity_begins_anew_about_the_next_one():
    broken = ranged(LENGTH, "5 cm", "cm", 5.0).holding("five")
    again = broken.holding("250 mm")
    assert (broken.scale, again.scale, again.unit, again.value) == ("none", "logarithmic", "mm", 250.0)
    assert (again.low, again.high) == pytest.approx((50.0, 1000.0))
    level = ranged(POWER, "-80 dBm", "dBm", -80.0).holding("2 nW")
    assert (level.scale, level.unit, level.low, level.high) == ("logarithmic", "nW", 0.5, 10.0)
    assert level.holding("-57 dBm").low == -67.0


def test_the_groups_of_sliders_stand_in_the_order_that_is_asked_for(draft):
    text = "[b]\nx = 1\n[terminals]\nleo_aperture = '5 cm'\ngeo_aperture = '7 cm'\n[beacon]\nstrehl = 0.5\n"
    found = sliders.grouped(
        draft.with_text(text),
        ("Second", "Empty", "First"),
        lambda key: {"terminals": "First", "beacon": "Second"}.get(key.partition(".")[0], ""),
    )
    assert {name: [each.key for each in those] for name, those in found.items()} == {
        "Second": ["beacon.strehl"],
        "First": ["terminals.leo_aperture", "terminals.geo_aperture"],
    }
    assert [*found] == ["Second", "First"]


def test_figures_within_a_verdict_within_a_view_are_drawn_by_their_names(figures):
    from microrad.report.view import Drawing, Verdict

    timeline, volume = figures["day-timeline"], figures["data-volume"]
    still = replace(volume, alive=False)
    blocks = [View("v", [Verdict("h", [timeline, Drawing("sketch", "t", "c", "<svg>µ</svg>")])]), "text", still]
    found = plots.drawn(blocks)
    assert [*found] == ["day-timeline", "sketch", "data-volume"]
    assert found["day-timeline"]["data"] and found["data-volume"] == plots.address(volume.svg)
    assert base64.b64decode(found["sketch"].partition(",")[2]).decode() == "<svg>µ</svg>"


def test_panels_side_by_side_stand_apart_and_keep_the_height_of_the_sheet():
    at = np.array([0.0, 1.0])
    plain = plots.plot(Axis("x"), Axis("y"), Line(at, at))
    named = plots.plot(Axis("x"), Axis("y"), Line(at, at, label="a"))
    tall = plots.plot(Axis("x"), Axis("y"), Line(at, at, label="a"), height=5.0)
    assert named["layout"]["height"] - named["rows"] == plain["layout"]["height"] - plain["rows"] + 30
    assert tall["rows"] - named["rows"] == pytest.approx(1.4 * 96, abs=1)
    layout = named["layout"]
    margin = layout["margin"]
    assert layout["height"] == pytest.approx(named["rows"] + margin["t"] + margin["b"] + 30, abs=1)
    assert (layout["xaxis"]["domain"], layout["yaxis"]["domain"]) == ([0.0, 1.0], [0.0, 1.0])


def test_rows_stand_from_the_top_with_a_name_at_each():
    axis = plots.rows(["a", "b", "c"])
    assert (axis.low, axis.high, axis.ticks, axis.grid) == (2.6, -0.6, {0: "a", 1: "b", 2: "c"}, False)


@pytest.mark.parametrize(
    ("lacking", "words"),
    [
        (("orbit",), "The mission has no [orbit], so it has no day; microrad init writes such tables."),
        (("operations",), "The mission has no [operations], so it has no day; microrad init writes such tables."),
        (("orbit", "operations"), "The mission has no [orbit] and no [operations], so it has no day; microrad"),
    ],
)
def test_a_table_that_a_day_lacks_is_named(lacking, words):
    tables = {name: None if name in lacking else object() for name in ("orbit", "operations")}
    said = day_view.missing(SimpleNamespace(mission=SimpleNamespace(**tables)))
    assert said == words or (len(lacking) == 2 and said.startswith(words))


def test_a_day_says_what_it_is_at_before_it_has_steps(monkeypatch):
    said = []
    monkeypatch.setattr(day_view.link_study, "run_link_study", lambda file: said.append(file) or "links")
    monkeypatch.setattr(
        day_view.day_study, "run_day_study", lambda links, on_progress: on_progress(3, 7, "passes") or (links, "day")
    )
    assert day_view.compute_day("file", lambda *told: said.append(told)) == ("links", "day")
    assert said == [(0, 0, "links"), "file", (0, 0, "contacts"), (3, 7, "passes")]


def test_a_cancelled_question_is_dropped_while_its_progress_is_told():
    latest, begun, go = Latest(), threading.Event(), threading.Event()
    done = []

    def work(progress):
        progress(2, 5, "half")
        begun.set()
        go.wait(HANG_S)
        progress(3, 5, "more")
        done.append("not dropped")

    latest.ask("a", work)
    assert begun.wait(HANG_S)
    state = latest.state
    assert (state.key, state.running, state.done, state.total, state.what) == ("a", True, 2, 5, "half")
    assert (state.result, state.error) == (None, "")
    thread = latest._thread
    latest.cancel()
    go.set()
    thread.join(HANG_S)
    assert (done, latest.state) == ([], type(state)())


@pytest.mark.parametrize("typed", ["1e300 dB", "-1e300 dB", "1e18 dB", "1.7e308 dB"])
def test_a_value_in_decibels_beside_which_ten_are_nothing_has_no_slider(draft, typed):
    key = "requirement.margin"
    made = slider_of(draft.set(key, typed), key)
    held = slider_of(draft, key).holding(typed)
    assert {(each.scale, each.position, each.typed) for each in (made, held)} == {("none", 0, typed)}
    for number in (0.0, -10.0):  # at the only value that the mission takes, and ten below the least
        assert ranged(Quantity("dB", least=0.0, most=0.0), f"{number:g} dB", "dB", number).position == 0


@pytest.mark.parametrize(
    ("error", "words", "told"),
    [
        (OSError(28, "No space left on device"), "[Errno 28] No space left on device", []),
        (
            ZeroDivisionError("division by zero"),
            "it ended with ZeroDivisionError: division by zero",
            ["division by zero"],
        ),
    ],
)
def test_a_question_whose_work_fails_in_another_way_ends_all_the_same(monkeypatch, error, words, told):
    def fails(progress):
        raise error

    seen, latest = [], Latest()
    monkeypatch.setattr(threading, "excepthook", lambda args: seen.append(str(args.exc_value)))
    latest.ask("a", fails)
    state = latest.wait(HANG_S)
    assert (state.running, state.error, seen) == (False, words, told)


DRAWN = {
    "margin map": """
height 424, 375 of it rows
xaxis: data rate (Mbit/s) log 1 to 4 bare
yaxis: pointing error (µrad) linear 0 to 21.9 bare
heatmap : x=65:10..96.466..10000 y=61:0..7.3..21.9 z=3965:20.44..9.4..-20.26
scatter 0 dB: #ffffff 2 dash x=61:1105.5..840.83..94.18 y=61:0..7.3..21.9
scatter 1.7 dB: #ffffff 2.93 solid x=61:747.4..568.47..63.673 y=61:0..7.3..21.9
scatter working point: #D55E00 13.33 circle x=622.08 y=7.3
""",
    "lines": """
height 296, 217 of it rows
xaxis: angle (µrad) linear 0 to 447.5 grid
yaxis: linear 9.6 to -0.6 bare Body pointing, Orbit knowledge, Misalignment, Point-ahead, root sum square, class \
by class, ECSS, one axis, ECSS, two axes, ECSS, two like axes, radial distribution
bar random (keyed): #E69F00 x=300 y=0 base=0
bar drift (keyed): #009E73 x=24 y=1 base=0
bar bias (keyed): #0072B2 x=100,21 y=2,3 base=0,0
bar total (keyed): #777777 x=317.83,426.18,280.63,396.87,204.42,316.15 y=4,5,6,7,8,9 base=0,0,0,0,0,0
line beacon's half angle: 406 µrad (keyed): #D55E00 2 dash x0=406 x1=406 y0=0 y1=1 above
""",
    "coverage": """
height 286, 207 of it rows
xaxis: angle off the line of sight (µrad) linear 0 to 507.5 grid
yaxis: probability of an error below it (%) linear 0 to 101 grid
scatter inside this angle (keyed): #0072B2 2.53 solid x=241:0..169.17..507.5 y=241:0..34.078..99.907
line beacon's half angle: 406 µrad (keyed): #D55E00 2 solid x0=406 x1=406 y0=0 y1=1 above
line root sum square: 318 µrad (keyed): #E69F00 2 dash x0=317.83 x1=317.83 y0=0 y1=1 above
line ECSS, two axes: 397 µrad (keyed): #009E73 2 dashdot x0=396.87 x1=396.87 y0=0 y1=1 above
line 87.5 % inside: 316 µrad (keyed): #000000 2 dot x0=316.15 x1=316.15 y0=0 y1=1 above
""",
    "coverage without a beacon": """
height 301, 222 of it rows
xaxis: angle off the line of sight (µrad) linear 0 to 496.1 grid
yaxis: probability of an error below it (%) linear 0 to 101 grid
scatter inside this angle (keyed): #0072B2 2.53 solid x=241:0..165.36..496.09 y=241:0..32.547..99.863
line root sum square: 318 µrad (keyed): #E69F00 2 dash x0=317.83 x1=317.83 y0=0 y1=1 above
line ECSS, two axes: 397 µrad (keyed): #009E73 2 dashdot x0=396.87 x1=396.87 y0=0 y1=1 above
line 87.5 % inside: 316 µrad (keyed): #000000 2 dot x0=316.15 x1=316.15 y0=0 y1=1 above
""",
}


@pytest.mark.parametrize("name", ["margin map", "lines", "coverage", "coverage without a beacon"])
def test_a_figure_of_the_links_is_drawn_with_its_axes_colours_dashes_and_key(draft, name):
    if name == "margin map":
        figure = link_view.map_plot(link_view.view(unlike(draft).link()))
    else:
        changes = {"pointing.confidence": "0.875", "beacon.divergence": "812 urad", "point_ahead.error": "21 urad"}
        found = pointing_view.view(unlike(draft, **changes).link())
        if name.endswith("without a beacon"):
            found = replace(found, budget=replace(found.budget, reading=None))
        figure = (pointing_view.lines_plot if name == "lines" else pointing_view.coverage_plot)(found)
    assert plot_lines(figure) == DRAWN[name].strip().splitlines()


SELDOM = """terminals.leo_obscuration beacon.wavefront_error requirement.outage answer.strehl beacon.wavelength
communication.transmit_optics_loss answer.receive_optics_loss communication.implementation_loss"""
OFTEN = """beacon.divergence answer.transmit_power terminals.geo_aperture communication.data_rate requirement.margin
beacon.distance communication.receiver_sensitivity answer.pointing_error beacon.required_power"""


@pytest.mark.parametrize("key", [*SELDOM.split(), *OFTEN.split()])
def test_each_number_of_the_links_stands_in_front_or_behind(key):
    assert link_view.second(key) is (key in SELDOM.split())


@pytest.mark.parametrize(
    ("table", "group"),
    [
        *(("terminals", "Telescopes"), ("communication", "Communication"), ("beacon", "Beacon"), ("answer", "Answer")),
        ("requirement", "Required"),
    ],
)
def test_the_sliders_of_a_table_stand_under_its_name_in_the_order_of_the_text(draft, table, group):
    groups = link_view.sliders(draft)
    assert [*groups] == ["Telescopes", "Communication", "Beacon", "Answer", "Required"]
    numbers = [key for key, each in draft.values.items() if key.startswith(f"{table}.") and key.count(".") == 1]
    numbers = [key for key in numbers if draft.values[key].about.kind in ("quantity", "number")]
    assert [each.key for each in groups[group]] == numbers != []


PARTS = {
    "links": """
Not every requirement is met: communication margin; communication +1.31 dB, beacon +4.36 dB, answer
Table The answer's light on the tracking sensor (The answer's light on the tracking sensor: noise-eq
Points
Figure What moves the margin
View What moves the margin of the beacon (folded)
  Figure What moves the margin of the beacon
View What moves the margin of the answer (folded)
  Figure What moves the margin of the answer
View Acquisition
  Exact sums over all orders of failures beside a seeded simulation of the same process. The wide be
  The scan covers 491 µrad about the predicted direction, for an uncertainty of 151 µrad rms per axi
  Table
  View Stages of the wide beacon, and one simulated run (folded)
    Table
    Table One simulated run
  View Stages of the spiral scan, and one simulated run (folded)
    Table
    Table One simulated run
  View Wide beacon or scan (folded)
    Figure Wide beacon or scan
View SDA Optical Communications Terminal (OCT) Standard (folded)
  Of 17 requirements that public sources print of it, up to version 4.0.0 (July 2024), 6 are met and
  Table
  Soft Read from what public sources print of versions 3.0 to 4.0.0 and not from the standard itself
""",
    "pointing": """
Table
Soft Largest allowed: the half width at which the root sum square, or the total of ECSS for two axes
Table  (Totals at 87.5 %: root sum square 318 µrad; class by class 426 µrad; ECSS, one axis 281 µrad
Read as full-1/e2, the beacon's half angle is 390 µrad, at least the root sum square of one axis. It
View Point-ahead
  Point-ahead: up to 71 µrad, 3.6 half angles of the communication beam; left out, it would cost mor
""",
    "pointing without beacon and point-ahead": """
The mission has no beacon, so nothing is to be covered.
Table
Table  (Totals at 87.5 %: root sum square 318 µrad; class by class 426 µrad; ECSS, one axis 281 µrad
View Point-ahead
  Soft The mission has no table [point_ahead].
""",
    "day": """
In 24 h the relay is in view 15 times, 913 min in all, and could carry 2.05 TB. The ground (kiruna)
The relay is in view for 63.4 % of the time, 54.7 min at a time (median), and out of it for 41 min a
With a pointing loss of 2.23 dB (communication.pointing_error, 10 µrad) the laser link has the deman
What becomes of the 32.4 GB that the instrument makes: by the relay half arrives within 1 s, and 99
What matters most to the ratio of the two volumes, each assumption changed alone: laser data rate (1
How late data arrive depends most on laser data rate: with 150 Mbit/s or 600 Mbit/s, 99 % arrive wit
Warnings:
Points
Table Relay and direct downlink (What the ways could carry: 2.05 TB by relay and 54.2 GB by direct d
Table Contacts (Every contact)
Table One assumption changed (One assumption changed, all others as they are)
Figure Contacts over time
View Along contact 1 (folded)
  Figure Along contact 1
Figure Data generated, delivered and stored
View From recording to delivery (folded)
  Figure From recording to delivery
View Ground track, relays and stations (folded)
  Figure Ground track, relays and stations
View What the assumptions decide (folded)
  Figure What the assumptions decide
""",
}


def parts_of(draft, name):
    """The blocks of a page of the design, but for what tables and lists hold."""
    if name == "links":
        blocks = link_view.blocks(link_study.run_link_study(unlike(draft).link()))
    else:
        found = pointing_view.view(
            unlike(draft, **{"pointing.confidence": "0.875", "point_ahead.error": "21 urad"}).link()
        )
        if name == "pointing without beacon and point-ahead":
            found = replace(found, ahead=None, budget=replace(found.budget, reading=None))
        blocks = pointing_view.blocks(found)
    return [line for line in block_lines(blocks) if not line.lstrip().startswith(("|", "-"))]


@pytest.mark.parametrize("name", ["links", "pointing", "pointing without beacon and point-ahead"])
def test_a_page_of_the_design_has_its_parts_in_their_order(draft, name):
    assert [line[:100].rstrip() for line in parts_of(draft, name)] == PARTS[name].strip().splitlines()


def test_the_day_has_its_parts_in_their_order_and_its_map_as_a_picture(day):
    lines = [line for line in block_lines(day_view.blocks(day)) if not line.lstrip().startswith(("|", "-"))]
    assert [line[:100].rstrip() for line in lines] == PARTS["day"].strip().splitlines()


@pytest.mark.parametrize("keyed", [False, True])
def test_a_figure_has_the_margins_of_its_widest_panels_and_the_places_of_each(monkeypatch, keyed):
    panels = [
        {"x": "xaxis", "y": "yaxis", "inner": [11, 22, 90, 60], "outer": [1, 2, 103, 74]},
        {"x": "xaxis2", "y": "yaxis2", "inner": [120, 20, 195, 61], "outer": [103, 5, 210, 77]},
    ]
    layout = {name: {} for name in ("xaxis", "yaxis", "xaxis2", "yaxis2")} | {"shapes": [{"type": "rect"}]}
    entries = [
        {"label": "one & <two>", "data": [0, 1], "shapes": [0], "line": {}},
        {"label": "alone", "data": [], "shapes": [], "line": {"color": "red"}},
    ]
    keys = [{"entries": entries}] * keyed
    made = {"data": [{"y": [1]}, {"y": [2]}, {"y": [3]}], "layout": layout, "panels": panels, "keys": keys}
    monkeypatch.setattr(plots, "plot_of", lambda sheet: made)
    found = plots.figure(Sheet(1.0, 1.0))
    assert found["rows"] == 41
    assert found["layout"]["height"] == 41 + 20 + 16 + 30 * keyed
    assert found["layout"]["margin"] == {"l": 17, "t": 20, "r": 15, "b": 16}
    domains = {name: found["layout"][name]["domain"] for name in ("xaxis", "yaxis", "xaxis2", "yaxis2")}
    assert domains == {
        **{"xaxis": pytest.approx([0.0, 79 / 184]), "yaxis": pytest.approx([1 / 41, 39 / 41])},
        **{"xaxis2": pytest.approx([109 / 184, 1.0]), "yaxis2": pytest.approx([0.0, 1.0])},
    }
    assert [found["layout"][name].get("automargin") for name in domains] == [None, True, None, True]
    assert found["layout"]["legend"] == {
        "orientation": "h",
        "y": 1.02,
        "yanchor": "bottom",
        "x": 0.0,
        "font": {"size": 12},
    }
    assert (found["layout"]["paper_bgcolor"], found["layout"]["plot_bgcolor"]) == ("white", "white")
    assert found["layout"]["showlegend"] is True
    told = [(each.get("name"), each["showlegend"]) for each in found["data"]]
    label = "one &amp; &lt;two&gt;"
    assert told == ([(label, True), (label, False), (None, False), ("alone", True)] if keyed else [(None, False)] * 3)
    if keyed:
        assert found["data"][3]["line"] == {"color": "red"} and found["data"][3]["x"] == [None]
        assert found["layout"]["shapes"] == [{"type": "rect", "name": label, "legendgroup": label, "showlegend": False}]


def test_a_figure_that_shows_nothing_says_why_in_its_middle():
    note = {"text": "none &amp; &lt;no&gt;", "xref": "paper", "yref": "paper", "x": 0.5, "y": 0.5, "showarrow": False}
    found = plots.empty("none & <no>")
    assert (found["data"], [*found]) == ([], ["data", "layout", "config"])
    assert found["layout"] == {
        **{"paper_bgcolor": "white", "plot_bgcolor": "white", "margin": {"l": 10, "r": 10, "t": 10, "b": 10}},
        **{"xaxis": {"visible": False}, "yaxis": {"visible": False}, "annotations": [note]},
    }
    less = ["lasso2d", "select2d", "autoScale2d"]
    assert found["config"] == {"displaylogo": False, "responsive": True, "modeBarButtonsToRemove": less}


@pytest.mark.parametrize(
    ("svg", "address"),
    [("<svg/>", "PHN2Zy8+"), ("<svg>é</svg>", "PHN2Zz7DqTwvc3ZnPg=="), ("", "")],
)
def test_a_picture_is_the_address_of_an_image(svg, address):
    assert plots.address(svg) == f"data:image/svg+xml;base64,{address}"


def test_a_confidence_below_all_of_the_time_is_not_told_as_all_of_it(draft):
    found = pointing_view.view(draft.set("pointing.confidence", "0.9999999").link())
    names = [shape.get("name", "") for shape in pointing_view.coverage_plot(found)["layout"]["shapes"]]
    _, _, totals, said, _ = pointing_view.blocks(found)
    assert any(name.startswith("99.99999 % inside: ") for name in names)
    assert totals.folded.startswith("Totals at 99.99999 %: ") and " 99.99999 % would take " in said


def test_a_contour_has_no_rate_where_the_whole_frame_has_more_or_less_than_its_margin(monkeypatch):
    """A link with 30 dB at 1 Mbit/s on axis, that falls as rates do and by the square of the error in microradians."""

    def margin(data, rates, errors):
        return 30.0 - 10.0 * np.log10(rates / 1e6)[:, None] - np.atleast_1d(errors * 1e6)[None, :] ** 2

    monkeypatch.setattr(link_view.link, "margin_map", lambda *given: margin(given[0], *map(np.atleast_1d, given[1:])))
    frame = link_view.Frame(np.geomspace(1e6, 1e9, 5), np.array([0.0, 1.0, 3.0, 5.0, 6.0]) * 1e-6)
    found = {level: link_view.contour(None, frame, level) for level in (6.0, -5.0)}
    assert found[6.0] == pytest.approx(1e6 * 10.0 ** np.array([2.4, 2.3, 1.5, np.nan, np.nan]), rel=1e-9, nan_ok=True)
    assert found[-5.0] == pytest.approx(
        1e6 * 10.0 ** np.array([np.nan, np.nan, 2.6, 1.0, np.nan]), rel=1e-9, nan_ok=True
    )


def test_a_question_that_cannot_read_a_file_ends_with_the_words_of_the_system_and_how_far_it_came():
    latest = Latest()

    def work(progress):
        progress(2, 5, "rows")
        raise FileNotFoundError(2, "No such file or directory", "a.csv")

    latest.ask("a", work)
    state = latest.wait(HANG_S)
    assert (state.error, state.running) == ("[Errno 2] No such file or directory: 'a.csv'", False)
    assert (state.key, state.done, state.total, state.what, state.result) == ("a", 2, 5, "rows", None)


def test_two_questions_of_one_owner_are_apart_by_their_names():
    owner = threading.Event()
    day, other = shared(owner, "day"), shared(owner, "links")
    assert day is not other
    assert (shared(owner, "day"), shared(owner, "links")) == (day, other)


@pytest.mark.parametrize("ends", ["answer", "progress", "refusal", "fault", "memory"])
def test_a_question_that_is_asked_again_has_nothing_of_the_one_that_was_cancelled(ends):
    """The same question: its first thread still works, and whatever becomes of it is dropped."""
    latest, begun, go = Latest(), threading.Event(), threading.Event()
    raised = {"refusal": ValueError("old"), "fault": KeyError("old"), "memory": MemoryError()}

    def old(progress):
        begun.set()
        go.wait(HANG_S)
        if ends == "progress":
            progress(1, 9, "old")
        if ends in raised:
            raise raised[ends]
        return "old"

    latest.ask("a", old)
    assert begun.wait(HANG_S)
    first = latest._thread
    latest.cancel()
    latest.ask("a", lambda progress: progress(2, 3, "new") or "new")
    seen = [latest.wait(HANG_S)]
    go.set()
    first.join(HANG_S)
    seen.append(latest.state)
    assert [(s.key, s.running, s.done, s.total, s.what, s.result, s.error) for s in seen] == [
        ("a", False, 2, 3, "new", "new", "")
    ] * 2
    assert latest._thread is not first and not first.is_alive()
