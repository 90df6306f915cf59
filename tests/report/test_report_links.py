"""What the pages say of the links: rows, sentences and figures, against the records that they are made from."""

import csv
import io
import json
import math
import re
import xml.etree.ElementTree as ET
from dataclasses import replace
from html import escape
from types import SimpleNamespace

import numpy as np
import pytest

from drawn import figure_of, one_text, outline
from drawn import plain as rounded
from link_files import RECEIVERS, data_with, link_file, received_with, written
from microrad import link
from microrad.core.budget import Line
from microrad.link import Swing, variation
from microrad.link import study as link_study
from microrad.link.acquisition.partner_search import LONGEST_LOOK_S, Scanned, Tracking
from microrad.link.requirement import Requirement
from microrad.mission.file import load_link
from microrad.report import requirements
from microrad.report.links import budgets as budget_views
from microrad.report.links import data as links_numbers
from microrad.report.links import figures as link_module
from microrad.report.links import views as links
from microrad.report.links import words as links_words
from microrad.report.links.budgets import links_csv, links_text
from microrad.report.links.data import links_data, performance_data
from microrad.report.links.figures import link_figures
from microrad.report.links.views import (
    acquisition_paragraphs,
    acquisition_view,
    fade_sentences,
    links_page,
    paired_tables,
    performance_note,
    performance_table,
    pointing_view,
    residuals_sentence,
)
from microrad.report.plotting import palette
from microrad.report.quantities import apart, quantity
from microrad.report.study.page import cost_view
from microrad.report.tables import Table
from microrad.report.view import Soft, View, views_text
from microrad.studio.views import pointing as pointing_pages
from microrad.study.pointing_penalty import FINE, Cost, LinkPerformance
from report_pages import without_scripts

FEW = {"acquisition.runs": 100}
NO_SCAN = {**FEW, "acquisition.scan": None}
JITTER = {"jitter": {"bias": ["1 urad", "0 urad"], "rms": ["3 urad", "3 urad"], "bandwidth": "50 Hz"}}
TORNADOS = ("tornado", "tornado-beacon", "tornado-answer")
UNDER_JITTER = budget_views.UNDER_JITTER
YEAR_S = 365.25 * 86400.0
SVG = "{http://www.w3.org/2000/svg}"


def studied(folder, *changes):
    return link_study.run_link_study(link_file(folder, *changes))


@pytest.fixture(scope="module")
def plain(tmp_path_factory):
    """The paper's links with both ways to find the partner, under a jitter."""
    return studied(tmp_path_factory.mktemp("plain"), FEW, JITTER)


def case(plain, **values):
    """The link under the jitter, with values of its record replaced."""
    return replace(plain.under_jitter, **values)


def micro(text):
    """An angle of a cell, in microradians."""
    value, unit = text.split()
    return float(value) * {"nrad": 1e-3, "\u00b5rad": 1.0, "mrad": 1e3, "rad": 1e6}[unit]


# ------------------------------------------------------------------------------------------------------ cells of shares
@pytest.mark.parametrize(
    ("share", "text"),
    [
        (0.0, "none"),
        (4.08e-6, "4.1e-06"),
        (9.99e-4, "1.0e-03"),
        (1e-3, "0.1 %"),
        (0.0042, "0.42 %"),
        (0.529, "53 %"),
        (0.997, "100 %"),
        (1.0, "100 %"),
    ],
)
def test_a_share_of_the_time_is_a_percentage_until_it_is_too_small_for_one(share, text):
    assert links.share(share) == text


def test_the_cells_of_a_case_are_its_record(plain):
    c = case(
        plain,
        mean_loss_db=1.234,
        outage_loss_db=2.346,
        margin_db=-0.014,
        outage=0.02,
        short=0.0,
        data_rate_bit_s=242.4e6,
    )
    cells = links.cells(c)
    rms = math.sqrt(1.0**2 + 2 * 3.0**2)
    assert cells[0] == f"{rms:.2f}"
    assert cells[1:7] == ["1.23", "2.35", "unknown", "\u22120.01", "2 %", "none"]
    assert cells[7:9] == ["19.7*", "0.00"]
    wider = replace(c.best, half_angle_rad=25.31e-6, at_limit=False, current_excess_db=0.456)
    assert links.cells(replace(c, best=wider))[7:9] == ["25.3", "0.46"]
    assert cells[9] == "242"
    assert links.cells(case(plain, data_rate_bit_s=math.nan))[9] == "none"
    assert links.cells(case(plain, data_rate_bit_s=1e5))[9] == "0.1"
    assert links.cells(case(plain, margin_db=2.0))[4] == "+2.00"
    assert [links.cells(case(plain, uncoded_penalty_db=each))[3] for each in (1.234, math.inf, math.nan)] == [
        "1.23",
        "beyond any power",
        "unknown",
    ]


@pytest.mark.promise("report-6")
@pytest.mark.parametrize("added", [True, False])
def test_a_line_of_the_pointing_budget_stands_in_every_face_once_the_mission_has_it(tmp_path, added):
    """As CONTRIBUTING says: a table of the mission, and no code."""
    name, source = "Thermal bending of the bench", "assumption: from a thermal analysis"
    table = '[pointing.lines.thermal_bending_of_the_bench]\nerror = "21 urad"  # assumption: from a thermal analysis\n'
    table += 'class = "drift"\nstatistic = "bound"\naxes = "per-axis"\n'
    path = written(tmp_path, data_with(NO_SCAN))
    path.write_text(path.read_text("utf-8") + table * added, "utf-8")
    found = link_study.run_link_study(load_link(path))
    terminal = " ".join(links_text(found, 400, verbose=True).split())
    studio = " ".join(views_text(pointing_pages.blocks(pointing_pages.view(found.file)), 400).split())
    cells = re.search(rf"<td[^>]*>{name}</td>.*?</tr>", without_scripts(links_page(found)), re.DOTALL)
    page = re.sub("<[^>]*>", " ", cells[0]) if cells else ""
    lines = {each["name"]: each for each in json.loads(json.dumps(links_data(found)))["pointing"]["lines"]}
    for face in (terminal, page, studio):
        assert (f"{name} 21 µrad" in " ".join(face.split()), source in face) == (added, added)
    assert (name in lines) is added
    assert not added or (lines[name]["value"], lines[name]["source"]) == (21e-6, source)


@pytest.mark.parametrize(
    ("margin_db", "rate_bit_s", "cells"),
    [
        (-3.104, -252.4e6, ["3.10", "252"]),
        (-3.104, -622e3, ["3.10", "0.62"]),
        (0.2, 3e6, ["\u22120.20", "\u22123"]),  # it can also gain
        (0.001, 3e5, ["0.00", "−0.3"]),
        (-0.004, 0.0, ["0.00", "0"]),
        (0.0, 0.0, ["0.00", "0"]),
        (-1.0, math.nan, ["1.00", ""]),
    ],
)
def test_what_hysteresis_costs_has_its_sign_and_is_blank_where_there_is_no_rate(margin_db, rate_bit_s, cells):
    assert links.cost_cells(Cost("a", "b", "c", margin_db, rate_bit_s)) == cells


@pytest.mark.promise("report-6")
def test_costs_stand_in_the_row_of_their_case_and_the_best_controller_is_marked(plain):
    cases = [
        case(plain, source=FINE, controller=name, mirror=mirror)
        for name in ("PID", "LQG")
        for mirror in ("given", "comparison")
    ]
    costs = [Cost(FINE, "LQG", "given", -0.5, -1e6)]
    table = performance_table(cases, costs, 0.003, "LQG")
    assert [tuple(row[1:3]) for row in table.rows] == [(c.controller, c.mirror) for c in cases]
    assert [row[-2:] for row in table.rows] == [["", ""], ["", ""], ["0.50", "1"], ["", ""]]
    assert [*table.best] == [2]
    assert {len(row) for row in (*table.rows, table.headings)} == {15}
    plainly = performance_table(cases, (), 0.003)
    assert {len(row) for row in (*plainly.rows, plainly.headings)} == {13}
    assert not performance_table([case(plain)], (), 0.003).best


def test_the_reference_without_hysteresis_has_no_row_and_the_missions_own_jitter_stands_first(plain):
    shown = case(plain, source="sine of 1 Hz", controller="PID", mirror="given")
    cases = (shown, replace(shown, mirror="no hysteresis"))
    found = LinkPerformance(0.003, 20e-6, cases, (Cost("sine of 1 Hz", "PID", "given", -1.0, -2e6),))

    def rows(links):
        ahead = SimpleNamespace(mission=SimpleNamespace(point_ahead=None))
        study = SimpleNamespace(links=links, performance=found, fine_pointing=None, file=ahead)
        table, *more = [block for block in cost_view(study).blocks if isinstance(block, Table)]
        assert more == []
        return [(row[0], row[2], *row[-2:]) for row in table.rows]

    simulated = ("sine of 1 Hz", "given", "1.00", "2")
    assert rows(replace(plain, under_jitter=None)) == [simulated]
    assert rows(plain) == [("jitter as given", "", "", ""), simulated]


def test_the_note_says_how_the_columns_are_read(plain):
    assert "loss at 0.3 % (dB)" in performance_table([case(plain)], (), 0.003).headings
    assert performance_note(costs=True).endswith("on a mirror without it.")
    assert performance_note(costs=False).endswith("at that loss.")
    assert "a star: the present one" in performance_note(costs=False)


def test_the_loop_under_vibration_is_named_only_where_it_was_simulated(plain):
    sine = case(plain, source="sine of 1 Hz", controller="PID", mirror="given")
    alone, both = (
        residuals_sentence(LinkPerformance(0.003, 19.7e-6, cases, ()))
        for cases in ((sine,), (sine, replace(sine, source=FINE)))
    )
    assert "Clean sines (one axis, as in the paper)." in alone
    assert "Clean sines first (one axis, as in the paper), then the loop under vibration and noise." in both
    assert "exceeded for 0.3 % of the time, against a beam of 19.7 \u00b5rad half angle" in alone


@pytest.mark.parametrize(
    ("one", "other", "unit", "texts"),
    [
        (390e-6, 389.9756e-6, "rad", ("390 µrad", "389.98 µrad")),
        (390e-6, 389e-6, "rad", ("390 µrad", "389 µrad")),
        (3.0, 3.0, "dB", ("3.00 dB", "3.00 dB")),
        (3.0, 2.9996, "dB", ("3.0000 dB", "2.9996 dB")),
        (1.0, 1.0 + 1e-12, "rad", ("1 rad", "1 rad")),
    ],
)
def test_two_values_have_the_digits_that_tell_them_apart(one, other, unit, texts):
    assert apart(one, other, unit) == texts


# --------------------------------------------------------------------------------------------------------------- fades
def test_fades_that_no_spectrum_tells_are_not_spoken_of(plain):
    assert fade_sentences(()) == []
    assert fade_sentences([case(plain, fades_per_s=math.nan)]) == []


def test_fades_rarer_than_one_in_a_year_are_not_counted(plain):
    rare = case(plain, fades_per_s=0.99 / YEAR_S)
    assert fade_sentences([rare]) == [
        "Fades below the required margin: less than one a year, for Gaussian errors of these spectra."
    ]
    for times in (1.0, 1.01):
        once = case(plain, fades_per_s=times / YEAR_S, fade_s=2e-3)
        assert re.search(r"3\.\d+e-08 a second of 2 ms each", fade_sentences([once])[0])
        assert re.search(r"3\.\d+e-08 a second of 2 ms each", fade_sentences([rare, once])[0])


def test_each_case_has_its_own_fades(plain):
    often = case(plain, controller="PID", fades_per_s=75.66, fade_s=7.512e-3, uncoded_penalty_db=1.234)
    rare = case(plain, controller="", source="jitter as given", fades_per_s=0.0, uncoded_penalty_db=math.nan)
    said = fade_sentences([often, rare, case(plain, controller="unknown", fades_per_s=math.nan)])
    assert said[0].endswith(": PID: 75.7 a second of 7.51 ms each; jitter as given: less than one a year.")
    assert len(said) == 1


# ------------------------------------------------------------------------------------------------------------- penalty
@pytest.mark.parametrize(
    ("penalty_db", "words"),
    [
        (1.014, "without a code 1.01 dB."),
        (math.inf, "without a code beyond any power."),
        (math.nan, "without a code unknown, as the receiver is given by its sensitivity alone."),
    ],
)
def test_the_penalty_is_said_with_a_code_and_without_however_rare_the_fades(plain, penalty_db, words):
    # and without a spectrum, too
    for fades_per_s in (0.0, math.nan):
        c = case(
            plain, mean_loss_db=0.414, outage_loss_db=2.456, uncoded_penalty_db=penalty_db, fades_per_s=fades_per_s
        )
        said = links_words.under_jitter_sentence(c, plain)
        coded = "with a code 0.41 dB where its interleaver spans many fades, 2.46 dB where it spans none; "
        assert said.endswith(coded + words)
        assert not re.search(r"\b(nan|inf)\b|  ", said)
        data = performance_data(c)
        assert (data["coded_penalty_many_fades_db"], data["coded_penalty_no_interleaver_db"]) == (0.414, 2.456)


@pytest.mark.promise("link-39")
def test_a_receiver_that_is_known_has_its_penalty_on_the_page_although_no_fade_is_as_deep(tmp_path):
    found = studied(tmp_path, NO_SCAN, JITTER, received_with("preamplified dpsk"))
    page = links_page(found)
    assert "less than one a year" in page
    assert 0.5 < found.under_jitter.uncoded_penalty_db < 2.0
    assert re.search(rf'<td class="number">{found.under_jitter.uncoded_penalty_db:.2f}(</td>| <span class="mark)', page)
    assert "Penalty, the power that the errors cost: with a code" in page


@pytest.mark.promise("link-39")
@pytest.mark.parametrize("name", [None, "preamplified dpsk"])
def test_the_rows_of_the_jitter_stand_in_the_csv(tmp_path, name):
    found = studied(tmp_path, NO_SCAN, JITTER, received_with(name) if name else {})
    p, known = found.under_jitter, name is not None
    rows = {r[1]: r for r in csv.reader(io.StringIO(links_csv(found))) if r[0] == UNDER_JITTER}
    expected = {
        "Mean pointing loss": -p.mean_loss_db,
        "Outage": p.outage,
        "Below required margin": p.short,
    } | ({"Penalty without a code": -p.uncoded_penalty_db} if known else {})
    assert {key: float(row[2]) for key, row in rows.items()} == expected
    assert rows["Mean pointing loss"][-1] == (
        "" if known else "the penalty without a code is unknown, as the receiver is given by its sensitivity alone"
    )
    assert UNDER_JITTER not in links_csv(studied(tmp_path, NO_SCAN))


def test_what_there_is_to_doubt_of_fades_is_said_once(plain):
    doubtful = case(
        plain, fades_per_s=1.0, fade_s=1e-3, uncoded_penalty_db=math.nan, fade_warning="half of it is noise"
    )
    assert fade_sentences([doubtful, doubtful])[1:] == ["Half of it is noise."]


# --------------------------------------------------------------------------------------------------- words on the links
CLOSED, BELOW, ABOVE = (link.Interval(2.0, 4.0, *ends) for ends in ((False, False), (True, False), (False, True)))
ANYWHERE = link.Interval(1.0, 5.0, True, True)
MOST = ", most (+7.00 dB) near 3 W"


@pytest.mark.parametrize(
    ("intervals", "said"),
    [
        ((ANYWHERE,), "wherever it was looked at"),
        ((BELOW,), "up to 4 W"),
        ((ABOVE,), "from 2 W on"),
        ((CLOSED,), "from 2 W to 4 W" + MOST),
        ((BELOW, replace(ABOVE, low=4.5)), "up to 4 W and from 4.5 W on" + MOST),
        ((CLOSED, replace(ABOVE, low=4.5)), "from 2 W to 4 W and from 4.5 W on" + MOST),
    ],
)
def test_the_values_of_a_key_are_told_with_their_ends_and_the_best_where_it_is_inside(intervals, said):
    solved = variation.Solved(intervals, (1.0, 5.0), 3.0, 7.0)
    solution = link_study.Solution("communication.transmit_power", "W", "communication", 3.0, solved, 2.0, None)
    assert links_words.solution_text(solution) == (
        f"communication.transmit_power leaves the required 3 dB of communication {said}. Looked at: 1 W to 5 W. "
        "The budgets below have 2 W."
    )
    none = replace(solution, solved=replace(solved, intervals=(), best_db=-0.5))
    assert links_words.solution_text(none) == (
        "No value of communication.transmit_power from 1 W to 5 W leaves the required 3 dB of communication: the most "
        "is \u22120.50 dB at 3 W. No other was looked at."
    )


@pytest.mark.parametrize(("ratio", "lost"), [(0.999, True), (1.0, False), (25.0, False)])
def test_light_below_its_noise_brings_no_angle(ratio, lost):
    angle = Line("Noise-equivalent angle", 2e-6, "rad", "", "", "")
    said = links_words._light(Tracking(3e-9, ratio, (), angle))
    assert said.startswith("The answer brings 3 nW to the tracking sensor: ")
    assert said.endswith(
        f"less than its noise in a reading (signal to noise {ratio:.2g})."
        if lost
        else "noise-equivalent angle 2 µrad rms per axis and reading."
    )
    assert "less than its noise" in links_words._light(Tracking(3e-9, 1e-7, (), None))


@pytest.mark.parametrize(
    ("loss_db", "corrected", "said"),
    [
        (19.96, False, "left out, it costs 20.0 dB; a mirror that makes it needs 80 µrad of"),
        (link.DEEPEST_DB, False, "left out, it costs 20.0 dB; a mirror that"),
        (link.DEEPEST_DB + 0.01, False, "left out, it costs more than 20 dB; a mirror that"),
        (3.0, True, "left out, it would cost 3.0 dB; a mirror that"),
    ],
)
def test_point_ahead_says_what_it_costs_up_to_where_side_lobes_decide(loss_db, corrected, said):
    text = links_words.point_ahead(link_study.PointAheadEffect(40e-6, corrected, 2.0, loss_db, 80e-6))
    assert text.startswith("Point-ahead: up to 40 µrad, 2.0 half angles of the communication beam; ")
    assert said in text
    assert text.endswith("line of sight; corrected here." if corrected else "line of sight; NOT corrected here.")


@pytest.mark.parametrize(("random", "ends"), [(None, ""), (False, ""), (True, " of both ends")])
def test_the_mean_loss_is_of_both_ends_where_the_receiver_is_shaken_too(plain, random, ends):
    receiving = None if random is None else SimpleNamespace(is_random=random)
    study = SimpleNamespace(data=SimpleNamespace(receiving=receiving, requirement=plain.data.requirement))
    c = case(plain, mean_loss_db=1.0)
    narrow = replace(c, best=replace(c.best, at_limit=True))
    wide = replace(c, best=replace(c.best, at_limit=False))
    assert links_words.under_jitter_sentence(c, study).startswith(f"Under the jitter: mean pointing loss{ends} 1.00 dB")
    assert " rad, the narrowest of the aperture. Power" in links_words.under_jitter_sentence(narrow, study).replace(
        "\u00b5", " "
    )
    assert "the narrowest" not in links_words.under_jitter_sentence(wide, study)


def test_what_moves_a_margin_is_told_by_three_inputs_and_only_where_any_does(plain):
    ends = [(3.5, 2.5), (3.0, -math.inf), (3.1, 3.0), (3.0, 3.0)]
    many = tuple(swing(plain, *each, key=f"communication.k{n}") for n, each in enumerate(ends))
    own, *others = plain.tornados

    def said(mine, theirs):
        changed = (replace(own, swings=mine), *(replace(each, swings=theirs) for each in others))
        return [each for each in links_words.consequences(replace(plain, tornados=changed)) if "What moves" in each]

    first, beacon, answer = said(many, many[:1])
    top = "communication.k0 1.00 dB; communication.k1 takes the link beyond its receiver; communication.k2 0.10 dB."
    assert first.endswith(f"ten times more or less): {top}")
    assert beacon == "What moves the margin of the beacon most: communication.k0 1.00 dB."
    assert answer == "What moves the margin of the answer most: communication.k0 1.00 dB."
    assert [len(said(*each)) for each in ((many, ()), ((), many), ((), ()))] == [1, 2, 0]


def test_the_largest_rate_is_told_with_the_receiver_that_ends_it_and_a_wider_beam_from_half_a_decibel_on(plain):
    beam = SimpleNamespace(radius_m=0.02)
    communication = plain.file.mission.communication.model_copy(update={"beam": beam})
    file = replace(plain.file, mission=plain.file.mission.model_copy(update={"communication": communication}))

    def said(gained_db=0.0, rate=1e9, most=None):
        receiver = None if most is None else SimpleNamespace(highest_data_rate_bit_s=most)
        data = replace(plain.data, receiver=receiver)
        radius = link_study.BeamRadius(0.03, gained_db)
        changed = replace(plain, file=file, data=data, largest_rate_bit_s=rate, beam_radius=radius)
        return links_words.consequences(changed)[:2]

    assert said()[0].endswith(": 1 Gbit/s.")
    assert said(most=1e9)[0].endswith(": 1 Gbit/s, the most that the receiver takes.")
    assert said(most=1.1e9)[0].endswith(": 1 Gbit/s.")
    assert said(rate=math.nan)[0].startswith("No data rate has the required 3 dB at ")
    assert said(0.5)[1] == (
        "The beam's radius of 20 mm leaves 0.50 dB to gain in the aperture of 50 mm: some 30 mm would be best."
    )
    assert not said(0.49)[1].startswith("The beam's radius")


@pytest.mark.parametrize(
    ("unit", "margin", "jitter", "said"),
    [
        ("dB", -10.0, None, "; to meet it, take communication.transmit_power = 50 W or more"),
        ("dB", -10.01, None, "; to meet it, change communication.k0"),
        ("dB", -10.01, (0.0, 0.0), "; to meet it, change communication.k0"),  # none of it to take away
        ("dB", -10.01, (0.0, 3e-6), "; to meet it, take jitter.rms = 2 µrad or less"),
        ("dB", -10.0, (0.0, 3e-6), "; to meet it, take communication.transmit_power = 50 W or more"),
        ("dB", 3.0, (0.0, 3e-6), "; to move it, change communication.transmit_power, which may be 2.51 W at least"),
    ],
)
def test_what_to_change_for_a_margin_goes_by_how_much_lacks(plain, monkeypatch, unit, margin, jitter, said):
    swings = (
        swing(plain, -math.inf, 3.0),
        swing(plain, 1.0, 3.0, key="requirement.outage"),
        swing(plain, 1.0, 3.0, key="communication.k0"),
    )
    tornado = link.Tornado("Communication", margin, swings)
    shaken = None if jitter is None else SimpleNamespace(rms_rad=jitter)
    m = SimpleNamespace(jitter=shaken, communication=SimpleNamespace(transmit_power_w=5.0))
    study = SimpleNamespace(file=SimpleNamespace(mission=m), tornados=(tornado,))
    r = Requirement("communication", "margin", unit, 0.0, margin, margin, "")
    solved = SimpleNamespace(solved=SimpleNamespace(intervals=[link.Interval(0.0, 2e-6, True, False)]))
    monkeypatch.setattr(link_study, "solve_key", lambda file, key: solved)
    assert requirements.advice_for_links(study, r) == said
    assert requirements.advice_for_links(study, replace(r, unknown="the sensor")) == ""
    none = replace(tornado, swings=swings[:2])
    if said.endswith("k0"):
        assert requirements.advice_for_links(SimpleNamespace(file=study.file, tornados=(none,)), r) == ""
    if "jitter" in said:
        solved.solved.intervals.clear()
        assert requirements.advice_for_links(study, r) == "; to meet it, change jitter.rms"


@pytest.mark.parametrize(("unit", "advised"), [("%", "850 µrad"), ("rad", "781 µrad")])
def test_a_cone_is_advised_wide_enough_for_what_is_asked_of_it(unit, advised):
    p = SimpleNamespace(confident_divergence_rad=850e-6, required_divergence_rad=780.2e-6)
    study = SimpleNamespace(open_loop=p, file=SimpleNamespace(mission=None))
    r = Requirement("cone", "cone", unit, 99.7, 90.0, -9.7, "")
    assert requirements.advice_for_links(study, r) == f"; to meet it, take beacon.divergence = {advised} or more"


# ------------------------------------------------------------------------------------------------- fades of a series
@pytest.mark.parametrize(
    ("cost_db", "text"),
    [
        (0.0, "0.00 dB"),
        (-1.5, "\u22121.50 dB"),
        (math.inf, "beyond any power"),
        (-math.inf, "none"),
        (math.nan, "none"),
    ],
)
def test_what_fades_cost_and_leave_is_said_where_it_is_no_number(cost_db, text):
    assert links.cost_text(cost_db) == text


def test_the_view_of_fades_has_what_is_known_and_what_is_not():
    short = SimpleNamespace(value=1e-3, low=1e-4, high=math.inf)
    long = SimpleNamespace(value=0.02, low=0.01, high=0.03)
    fading = SimpleNamespace(
        **{"code": "code", "source": "fades.csv", "target": 1e-6, "margin_db": 5.0, "margin_left_db": 3.0},
        **{"interleaving": "block", "span_s": 0.005, "ratio": short, "lost": long, "penalty_db": 2.0},
        fades=SimpleNamespace(
            **{"level": 0.5, "share": 0.25, "per_second": 2.0, "mean_s": 0.01},
            **{"median_s": math.nan, "ninetieth_s": 0.03, "longest_s": math.nan},
        ),
        curve=SimpleNamespace(span_s=(0.0, 0.01), penalty_db=(math.inf, 1.0)),
    )
    figures = [SimpleNamespace(name=name) for name in ("tornado", links_words.INTERLEAVER)]
    view = links.fading_view(fading, figures)
    said, found, fades, curve, shown, note = view.blocks
    assert [row[1:] for row in found.rows] == [
        ("10⁻³", "the series is too short for an interval"),
        ("2 %", "1 % to 3 % with 99 % confidence, between parts of the series"),
        ("2.00 dB", "brings the mean back to 10⁻⁶"),
        ("3.00 dB", "of 5.00 dB at constant power"),
    ]
    assert fades.title.startswith("Fades below \u22123.01 dB,")
    assert fades.rows == [("25 %", "2 Hz", "10 ms", "\u2013", "30 ms", "\u2013")]
    assert curve.rows == [("none", "beyond any power"), ("10 ms", "1.00 dB")]
    assert shown is figures[1] and isinstance(note, Soft)
    assert "with a block interleaver over 5 ms: mean bit error ratio 10⁻³" in said
    assert said.endswith("the fades cost 2.00 dB, which leaves a margin of +3.00 dB.")
    fading.interleaving, fading.penalty_db = "none", math.inf
    said = links.fading_view(fading).blocks[0]
    assert "code without an interleaver: mean" in said and said.endswith(
        "the fades cost more than any power makes up for."
    )
    assert links.fading_view(None, figures) is None


@pytest.mark.parametrize(
    ("needed_s", "said"),
    [
        (5e-3, ", in 2 s at most."),
        (5.01e-3, "the partner's sensor needs 5.01 ms in place of the 5 ms that are stated; the scan waits."),
        (
            LONGEST_LOOK_S,
            f"needs {quantity(LONGEST_LOOK_S, 's')} in place of the 5 ms that are stated; the scan waits.",
        ),
        (2 * LONGEST_LOOK_S, f"need more than {quantity(LONGEST_LOOK_S, 's')} in place of the 5 ms that are stated."),
    ],
)
def test_a_scan_waits_for_light_only_beyond_the_time_that_is_stated(needed_s, said):
    scanned = Scanned(None, 2.0, 100e-6, 28e-6, None, 5e-3, needed_s, None)
    text = links.scan_words(scanned, 30e-6)
    assert text.startswith("The scan covers 100 µrad about the predicted direction, for an uncertainty of 30 µrad rms")
    assert text.endswith(said)


@pytest.mark.parametrize(("count", "folded"), [(3, ""), (4, "The link under each of 4 pointing errors")])
def test_the_table_of_pointing_errors_is_folded_from_four_on(plain, count, folded):
    assert performance_table([case(plain)] * count, (), 0.003).folded == folded


@pytest.mark.parametrize(
    ("half_rad", "total_rad", "said"),
    [
        (None, 1e-6, []),
        (3e-6, 1e-6, ["covers it, 2 µrad left"]),
        (3e-6, 3e-6, ["covers it, 0 rad left"]),
        (1e-6, 3e-6, ["2 µrad short"]),
    ],
)
def test_a_total_is_covered_up_to_the_half_angle_itself(half_rad, total_rad, said):
    assert links._covered(half_rad, total_rad) == said


# ------------------------------------------------------------------------------------------------------------ pointing
def test_the_column_of_what_is_left_fills_the_beacons_cone(plain):
    table, note, totals, *_ = pointing_view(plain.open_loop).blocks
    lines = plain.open_loop.lines
    square = sum((line.value * 1e6) ** 2 for line in lines)
    for row, line in zip(table.rows, lines, strict=True):
        others = square - (line.value * 1e6) ** 2
        assert row[0] == line.name
        assert micro(row[3]) == pytest.approx(math.sqrt(390.0**2 - others), rel=6e-3)
        assert float(row[2].removesuffix(" %")) == pytest.approx(1e14 * line.value**2 / square, abs=0.06)
    assert "half angle (390 \u00b5rad)" in note.text
    assert totals.folded.startswith("Totals at 99.7 %: root sum square 390 \u00b5rad")
    assert [row[0] for row in totals.rows] == [each.name for each in plain.open_loop.summations]


def test_without_a_beacon_nothing_is_left_for_anything(tmp_path):
    found = studied(tmp_path, {"beacon": None, "acquisition": None})
    lines, *others = pointing_view(found.open_loop).blocks
    assert "largest allowed" not in lines.headings
    assert [type(each) for each in others] == [Table]
    assert not any(isinstance(each, Soft) for each in others)


def test_a_line_that_the_others_leave_nothing_is_told_so(tmp_path):
    found = studied(tmp_path, NO_SCAN, {"pointing.lines.body_pointing.error": "400 urad"})
    left = {row[0]: row[3] for row in pointing_view(found.open_loop).blocks[0].rows}
    assert left.pop("Body pointing") == "300 \u00b5rad"
    assert set(left.values()) == {"nothing"}


def test_the_sentence_on_coverage_tells_both_readings(plain, tmp_path):
    (said,) = links.coverage(plain.open_loop)
    own, other = plain.open_loop.reading, plain.open_loop.counter_reading
    assert "Read as full-1/e2, the beacon's half angle is 390 \u00b5rad, at least the root sum square" in said
    assert f"with a probability of {own.coverage:.4f}" in said
    assert said.endswith(
        f"Read as half-1/e2, the half angle is 780 \u00b5rad and the probability {other.coverage:.4f}."
    )
    narrow = studied(tmp_path, NO_SCAN, {"beacon.divergence": "600 urad"})
    assert "300 \u00b5rad, less than the root sum square" in links.coverage(narrow.open_loop)[0]


def test_no_sentence_is_said_twice_on_the_page(plain):
    page = without_scripts(links_page(plain))
    assert len(links_words.consequences(plain)) == 8
    for sentence in (links_words.verdict(plain), *links_words.consequences(plain), *links.coverage(plain.open_loop)):
        assert page.count(escape(sentence, quote=True).replace("&#x27;", "&#39;").replace("&quot;", "&#34;")) == 1


def test_no_sentence_is_said_twice_in_the_terminal(plain):
    limits = links_words.short(plain)
    brief, whole = (" ".join(links_text(plain, 160, verbose=verbose).split()) for verbose in (False, True))
    assert [brief.count(sentence) for sentence in limits] == [1] * len(limits)
    everything = dict.fromkeys([*limits[:-1], *links_words.consequences(plain), *plain.warnings])
    assert len(plain.warnings) > 1
    assert limits[-1].startswith("Warning 1 of")
    assert [sentence for sentence in everything if whole.count(" ".join(sentence.split())) != 1] == []


# ------------------------------------------------------------------------------------------------------ paired budgets
NAMES = ("as budgeted", "simulated")


def changed_line(budget, at, **values):
    """The budget with one of its lines replaced."""
    lines = list(budget.lines)
    lines[at] = replace(lines[at], **values)
    return replace(budget, lines=tuple(lines))


def test_a_total_that_one_of_two_budgets_lacks_is_an_empty_cell(plain):
    own = next(b for b in plain.budgets if b.name == "Communication")
    other = replace(own, totals=own.totals[:3], margin_db=-1.234)
    assert [line.name for line in own.totals] == ["Received power", "Required power", "Margin", "Static margin"]
    for pair, empty in (((own, other), 2), ((other, own), 1)):
        (table,) = paired_tables(*pair, NAMES)
        last = table.rows[-1]
        assert (last[0], last[empty], last[3 - empty]) == ("Static margin", "", quantity(own.totals[-1].value, "dB"))
        assert table.totals == 4
        assert len(table.rows) == len(own.lines) + 4
        assert "" not in [cell for row in table.rows[:-1] for cell in row[1:3]]
        margins = (quantity(own.margin_db, "dB"), quantity(-1.234, "dB"))
        one, two = margins if empty == 2 else margins[::-1]
        assert table.folded == f"Communication: margin {one} as budgeted, {two} simulated"
    (equal,) = paired_tables(other, other, NAMES)
    assert equal.totals == 3


@pytest.mark.promise("report-6")
def test_what_two_budgets_say_of_a_line_stands_there_where_it_differs(plain):
    own = next(b for b in plain.budgets if b.name == "Communication")
    at = next(k for k, line in enumerate(own.lines) if k and not line.warning)
    was = own.lines[at]
    other = changed_line(own, at, basis="other basis", source="other source", regime="other regime", warning="too far")
    (table,) = paired_tables(own, other, NAMES)
    assert [tuple(map(str, row[3:])) for row in table.rows[:at]] == [
        (line.basis, line.source, line.regime) for line in own.lines[:at]
    ]
    name, *_, basis, source, regime = table.rows[at]
    assert (basis, source) == (f"{was.basis}\nsimulated: other basis", f"{was.source}\nsimulated: other source")
    assert regime == f"{was.regime}\nsimulated: other regime"
    assert (name.text, name.mark, name.hint) == (was.name, "!", "simulated: too far")
    (back,) = paired_tables(other, own, NAMES)
    assert back.rows[at][0].hint == "as budgeted: too far"
    (both,) = paired_tables(other, changed_line(other, at, warning="farther"), NAMES)
    assert both.rows[at][0].hint == "as budgeted: too far; simulated: farther"
    (same,) = paired_tables(other, other, NAMES)
    assert same.rows[at][0].hint == "too far"


def test_two_budgets_of_other_lines_are_two_tables(plain):
    own = next(b for b in plain.budgets if b.name == "Communication")
    tables = paired_tables(own, replace(own, lines=own.lines[1:]), NAMES)
    assert [table.title for table in tables] == ["Communication, as budgeted", "Communication, simulated"]
    assert [len(table.rows) for table in tables] == [len(own.lines) + 4, len(own.lines) + 3]


# --------------------------------------------------------------------------------------------------------- acquisition
@pytest.mark.promise("report-6")
def test_the_rows_of_acquisition_are_those_of_the_record(plain):
    view = acquisition_view(plain.finding, ())
    (ways,) = (block for block in view.blocks if isinstance(block, Table))
    assert [row[0] for row in ways.rows] == ["wide beacon", "spiral scan"]
    assert ways.headings[-1] == "90 % within"
    for row, way, more in zip(ways.rows, (plain.finding.wide, plain.finding.scan), view.views, strict=True):
        locked = way.simulated.locked
        _, *cells, late = row
        assert cells == [
            f"{way.outcome.success_probability:.4f}",
            f"{np.mean(locked):.4f}",
            quantity(way.outcome.mean_time_s, "s"),
            quantity(float(np.mean(way.simulated.time_s[locked])), "s"),
        ]
        assert float(late.removesuffix(" s")) == pytest.approx(np.quantile(way.simulated.time_s[locked], 0.9), rel=0.25)
        stages, log = more.blocks
        assert [row[0] for row in stages.rows] == [each.name for each in way.stages]
        assert [row[0] for row in log.rows] == [each.stage for each in way.log]


def test_acquisition_that_never_locks_has_no_simulated_time(tmp_path):
    found = studied(tmp_path, NO_SCAN, {"answer.transmit_power": "1 mW"})
    (ways,) = (block for block in acquisition_view(found.finding, ()).blocks if isinstance(block, Table))
    (way,) = ways.rows
    assert way[2] == "0.0000"
    assert way[4] == "none locks"
    assert not any("nan" in cell for cell in way)


def test_the_words_on_acquisition_give_each_chance(plain, tmp_path):
    chances = plain.finding.chances
    words, scan = acquisition_paragraphs(plain.finding)
    for value in (chances.beacon_coverage, chances.answer_coverage, chances.answer_detection, chances.return_coverage):
        assert f"{value:.4f}" in words
    assert f"in {quantity(plain.finding.scanned.duration_s, 's')} at most." in scan
    assert len(acquisition_paragraphs(studied(tmp_path, NO_SCAN).finding)) == 1


# ------------------------------------------------------------------------------------------------------------- figures
def texts(figure):
    """The words of a figure."""
    return [each.text for each in ET.fromstring(figure.svg).iter(f"{SVG}text")]


@pytest.mark.promise("report-6")
def test_the_figures_are_svg_with_their_numbers_beside_them(plain):
    drawn = link_figures(plain)
    assert [figure.name for figure in drawn] == [*TORNADOS, "wide-beam-or-scan"]
    trade = drawn[-1]
    for figure in drawn:
        assert ET.fromstring(figure.svg).tag == f"{SVG}svg"
        assert figure.title
        assert len({np.size(column) for column in figure.columns.values()}) == 1
        assert all(np.isfinite(column).all() for column in figure.columns.values() if not isinstance(column, tuple))
    for figure, each in zip(drawn[:3], plain.tornados, strict=True):
        assert figure.columns["input"] == tuple(s.key for s in each.swings)
        assert figure.columns["SI unit"] == tuple(s.unit for s in each.swings)
        assert list(figure.columns["margin lower (dB)"]) == [s.margin_low_db for s in each.swings]
        assert list(figure.columns["margin higher (dB)"]) == [s.margin_high_db for s in each.swings]
        assert ("required" in texts(figure)) is (each.of == "Communication")
    axis = "margin of the communication link, for 99.7 % of the time (dB)"
    assert [axis in texts(figure) for figure in drawn[:3]] == [True, False, False]
    assert all(re.search(r"\((rad|s)\)|probability", name) for name in trade.columns)
    assert np.array_equal(trade.columns["scan, whole time (s)"], plain.finding.trade.scan_time_s)


def test_the_captions_give_the_missions_own_numbers(plain):
    trade = link_figures(plain)[-1]
    assert "99.5 % coverage" in trade.caption
    assert (
        "a beam of 27.9 \u00b5rad half angle at 1/e2, used out to 20 \u00b5rad and led over it with an overlap of 0.25 "
        "under 5 \u00b5rad of jitter" in trade.caption
    )
    least = 100 * float(np.min(plain.finding.trade.scan_probability))
    assert f"finds {least:.1f} % or more." in trade.caption


@pytest.mark.promise("report-12")
def test_there_is_no_trade_without_a_scan(tmp_path):
    both = ["tornado", "tornado-beacon", "tornado-answer"]
    assert [figure.name for figure in link_figures(studied(tmp_path, NO_SCAN))] == both
    assert [figure.name for figure in link_figures(studied(tmp_path, {"acquisition": None}))] == both
    alone = studied(tmp_path, dict.fromkeys(("acquisition", "beacon", "answer")))
    assert [figure.name for figure in link_figures(alone)] == ["tornado"]


def swing(plain, low_db, high_db, **others):
    values = {"key": "communication.data_rate", "unit": "bit/s", "value": 3e8, "low": 2.7e8, "high": 3.3e8}
    values |= {"kind": "", "source": "mission file", "margin_low_db": low_db, "margin_high_db": high_db}
    return Swing(**(values | others))


@pytest.mark.parametrize(
    "ends",
    [
        [(3.5, 2.5)],
        [(3.5, -math.inf)],
        [(-math.inf, -math.inf)],
        [(-math.inf, 3.0), (3.5, 2.5), (3.5, -math.inf)],
        [(3.0 + 1e-7, 3.0)],
    ],
    ids=["one", "too fast", "never", "several", "hardly any"],
)
def test_a_tornado_is_drawn_whatever_its_swings(plain, ends):
    own, *others = plain.tornados
    found = replace(plain, tornados=(replace(own, swings=tuple(swing(plain, *each) for each in ends)), *others))
    figure = link_figures(found)[0]
    ET.fromstring(figure.svg)
    assert not re.search(r"\b(nan|inf)\b", figure.svg)
    slow = sum(not all(map(math.isfinite, each)) for each in ends)
    assert texts(figure).count("< no margin: receiver too slow") == slow
    assert {"input lower", "input higher"} <= set(texts(figure))


def test_no_swing_is_no_tornado(plain):
    assert [figure.name for figure in link_figures(replace(plain, tornados=()))] == ["wide-beam-or-scan"]


def test_a_receiver_near_its_bandwidth_is_drawn_and_listed(tmp_path):
    found = studied(tmp_path, NO_SCAN, received_with("preamplified dpsk"), {"communication.data_rate": "3.1 Gbit/s"})
    assert math.isinf(found.tornados[0].swings[0].swing_db)
    figure = link_figures(found)[0]
    assert texts(figure).count("< no margin: receiver too slow") == 3  # rate, code rate and bandwidth
    assert math.isinf(figure.columns["margin higher (dB)"].min())


def test_a_tornado_shows_its_longest_bars_and_names_assumptions(plain):
    many = [
        swing(plain, 3 + x, 3 - x, key=f"communication.k{n}", kind="assumption" * (n == 1))
        for n, x in enumerate(np.linspace(2, 1, 30))
    ]
    own, *others = plain.tornados
    figure = link_figures(replace(plain, tornados=(replace(own, swings=tuple(many)), *others)))[0]
    labels = [text for text in texts(figure) if text and text.startswith("k")]
    assert len(labels) == link_module.MOST_BARS
    assert labels[0] == "k0 = 300 Mbit/s"
    assert figure.caption.endswith("Assumptions among them: communication.k1.")
    assert {len(column) for column in figure.columns.values()} == {30}
    assert figure.columns["input"][:2] == ("communication.k0", "communication.k1")


def test_the_required_margin_is_marked_where_it_is_in_sight(plain, tmp_path):
    assert "required" in texts(link_figures(plain)[0])
    far = studied(tmp_path, NO_SCAN, {"requirement.margin": "30 dB"})
    assert "required" not in texts(link_figures(far)[0])


# ------------------------------------------------------------------------------------------------------------ the page
def test_every_text_of_the_mission_is_escaped(tmp_path):
    path = written(tmp_path, data_with({**NO_SCAN, "name": "<script>alert(1)</script> & co"}))
    text = path.read_text(encoding="utf-8")
    line = 'transmit_power = "5 W"'
    assert text.count(line) == 1
    path.write_text(text.replace(line, f"{line} # literature: <img src=x onerror=y> 2021"), encoding="utf-8")
    page = without_scripts(links_page(link_study.run_link_study(load_link(path))))
    assert "<script" not in page
    assert "<img" not in page
    assert page.count("&lt;script&gt;alert(1)&lt;/script&gt; &amp; co") == 3  # title, heading and inputs
    assert page.count("literature: &lt;img src=x onerror=y&gt; 2021") == 2  # in the budget and among the inputs


def test_brackets_of_a_comment_are_no_markup_of_the_terminal(tmp_path):
    path = written(tmp_path, data_with(NO_SCAN))
    text = path.read_text(encoding="utf-8").replace(
        'transmit_power = "5 W"', 'transmit_power = "5 W" # paper: [bold] 2'
    )
    path.write_text(text, encoding="utf-8")
    assert "paper: [bold] 2" in links_text(link_study.run_link_study(load_link(path)), 160, verbose=True)


def test_the_page_holds_every_line_and_no_hyphen_for_a_minus(plain):
    page = without_scripts(links_page(plain))
    for _, line in budget_views.lines(plain):
        assert f">{quantity(line.value, line.unit)}</td>" in page
    plain_text = re.sub(r"<(svg|style).*?</\1>|<[^>]*>", " ", page, flags=re.DOTALL)
    assert not re.search(r"(?<![\w-])-\d+\.\d\d dB", plain_text)
    assert page.count("<figure") == page.count("</figure>") == 4
    assert page.count("<table") == page.count("</table>")


@pytest.mark.promise("report-6")
@pytest.mark.parametrize("name", ["pin ook", "counting ppm"])
def test_the_noise_of_a_receiver_has_its_table(tmp_path, plain, name):
    assert name in RECEIVERS
    found = studied(tmp_path, NO_SCAN, received_with(name))
    heading = "Noise of the communication receiver"
    assert (heading in links_page(found)) is bool(found.receiver_noise)
    own = [line for name, line in budget_views.lines(found) if name == "Communication receiver"]
    assert own == list(found.receiver_noise)
    assert heading not in links_page(plain)


def test_figures_name_their_data_only_where_they_stand_beside_the_page(plain):
    assert "figures/tornado.csv" not in links_page(plain)


@pytest.mark.parametrize(
    ("ends", "lost_db"),
    [
        ([(1.0, 5.0)], 0.0),
        ([(1.0, 3.5)], 0.0),
        ([(2.9, 5.0)], 0.0),
        ([(3.0, 3.0)], 2.0),
        ([(2.5, 3.1)], 2.0),
        ([(-math.inf, 9.0)], -6.0),
        ([], 2.0),
    ],
)
def test_the_bar_of_an_input_that_leaves_no_link_ends_beyond_all_others(ends, lost_db):
    """About a margin of 3 dB: half as far again as the longest bar, and at least 1 dB."""
    shown = [SimpleNamespace(margin_low_db=low, margin_high_db=high) for low, high in ends]
    assert link_module._lost(shown, 3.0) == pytest.approx(lost_db)


@pytest.mark.parametrize(
    ("colour", "opacity", "made"),
    [
        ("#102030", 1.0, "#102030"),
        ("#102030", 0.5, "rgba(16,32,48,0.5)"),
        ("#102030", 0.0, "rgba(16,32,48,0)"),
        ("", 0.5, ""),
    ],
)
def test_a_colour_is_written_with_its_opacity_where_it_has_one(colour, opacity, made):
    assert palette.clear(colour, opacity) == made


# ----------------------------------------------------------------------------------------------- limits and other ways
def fading_of(**changes):
    """A coded link under fades whose interleaver spans 10 ms."""
    given = {
        "ratio": SimpleNamespace(value=1e-7),
        "lost": SimpleNamespace(value=0.25),
        "penalty_db": 2.0,
        "margin_left_db": 1.0,
        "margin_db": 5.0,
        "code": "LDPC",
        "source": "a series",
        "target": 1e-6,
        "span_s": 0.01,
        "curve": SimpleNamespace(span_s=(0.0, 0.01, 0.1), penalty_db=(6.0, 2.0, math.inf)),
    }
    return SimpleNamespace(**given | changes)


def with_fading(plain, **changes):
    return SimpleNamespace(file=plain.file, fading=fading_of(**changes))


def test_a_number_of_the_fades_that_is_not_finite_has_no_row(plain):
    def rows(**changes):
        return [(line.name, line.value, line.unit) for line in budget_views.fading_lines(with_fading(plain, **changes))]

    ratio, windows = ("Mean bit error ratio", 1e-7, ""), ("Windows above the target", 0.25, "")
    assert rows() == [ratio, windows, ("Penalty of the fades", -2.0, "dB"), ("Margin under the fades", 1.0, "dB")]
    assert rows(penalty_db=math.inf, margin_left_db=-math.inf) == [ratio, windows]
    assert budget_views.fading_lines(SimpleNamespace(fading=None)) == []


def test_lines_have_the_open_loop_and_the_tracking_sensor_where_the_links_have_them(plain):
    names = {name for name, _ in budget_views.lines(plain)}
    assert {"Open-loop pointing", "Tracking sensor"} <= names
    without = {name for name, _ in budget_views.lines(replace(plain, open_loop=None))}
    assert names - without == {"Open-loop pointing"}
    blind = {name for name, _ in budget_views.lines(replace(plain, tracking=None))}
    assert names - blind == {"Tracking sensor"}
    angle = plain.tracking.noise_equivalent_angle
    told = [line for _, line in budget_views.lines(plain)]
    other = replace(plain, tracking=replace(plain.tracking, noise_equivalent_angle=None))
    assert (angle in told) and [line for _, line in budget_views.lines(other)] == [x for x in told if x is not angle]


@pytest.mark.parametrize("own", [None, object()])
def test_the_source_of_the_jitter_is_the_table_it_is_in(plain, monkeypatch, own):
    monkeypatch.setattr(budget_views, "source_text", lambda sources, *keys: ", ".join(keys))
    p = SimpleNamespace(mean_loss_db=0.5, uncoded_penalty_db=math.nan, outage=0.1, short=0.2)
    study = SimpleNamespace(under_jitter=p, data=SimpleNamespace(jitter=own), file=plain.file)
    found = budget_views.jitter_lines(study)
    table = "communication.coupling.jitter" if own is None else "jitter"
    assert {line.source for line in found} == {f"{table}.bias, {table}.rms, requirement.outage"}
    assert [(line.name, line.value) for line in found] == [
        ("Mean pointing loss", -0.5),
        ("Outage", 0.1),
        ("Below required margin", 0.2),
    ]
    assert found[0].warning.startswith("the penalty without a code is unknown") and found[1].warning == ""
    p.uncoded_penalty_db = 3.0
    known = budget_views.jitter_lines(study)
    assert (known[0].warning, known[1].name, known[1].value) == ("", "Penalty without a code", -3.0)
    assert budget_views.jitter_lines(SimpleNamespace(under_jitter=None)) == []


@pytest.mark.parametrize(
    ("changes", "labels"),
    [
        ({}, ["with an interleaver", "without one", "what the margin can spare", "this mission"]),
        ({"span_s": 0.0}, ["with an interleaver", "without one", "what the margin can spare"]),
        ({"penalty_db": math.inf}, ["with an interleaver", "without one", "what the margin can spare"]),
        (
            {"curve": SimpleNamespace(span_s=(0.0, 0.01), penalty_db=(math.inf, 2.0))},
            ["with an interleaver", "what the margin can spare", "this mission"],
        ),
    ],
)
def test_what_no_power_makes_up_for_has_no_mark_over_the_interleaver(plain, changes, labels):
    figure = link_module.interleaver(with_fading(plain, **changes), fading_of(**changes))
    (panel,) = figure.sheet.panels
    assert [mark.label for mark in panel.marks] == labels
    spare = next(mark for mark in panel.marks if mark.label == "what the margin can spare")
    assert spare.at == pytest.approx(5.0 - plain.file.mission.requirement.margin_db)
    if not changes:
        line, rule = panel.marks[:2]
        assert line.x == pytest.approx([10.0, 100.0]) and line.y[0] == 2.0 and math.isnan(line.y[1])
        assert rule.at == 6.0


def test_figures_are_of_what_the_links_have(plain, monkeypatch):
    for name in ("tornado", "trade", "over_elevation", "interleaver"):
        monkeypatch.setattr(link_module, name, lambda *of, name=name: name)
    some, none = SimpleNamespace(swings=(1,)), SimpleNamespace(swings=())
    two, one = SimpleNamespace(elevations=(1, 2)), SimpleNamespace(elevations=(1,))
    links_of = {"tornados": (some, none), "finding": None, "ground": None, "fading": None}
    for changes, drawn in (
        ({}, ["tornado"]),
        ({"tornados": (none,)}, []),
        ({"finding": SimpleNamespace(trade=None)}, ["tornado"]),
        ({"finding": SimpleNamespace(trade=1)}, ["tornado", "trade"]),
        ({"ground": two}, ["tornado", "over_elevation"]),
        ({"ground": one}, ["tornado"]),
        ({"fading": 1}, ["tornado", "interleaver"]),
    ):
        assert list(link_figures(SimpleNamespace(**links_of | changes))) == drawn


@pytest.mark.parametrize(("required_db", "shown"), [(1.0, 0), (1.01, 1), (4.99, 1), (5.0, 0)])
def test_the_required_margin_is_marked_strictly_within_the_axis(plain, monkeypatch, required_db, shown):
    monkeypatch.setattr(link_module, "limits", lambda *of: (1.0, 5.0))
    m = plain.file.mission
    requirement = m.requirement.model_copy(update={"margin_db": required_db})
    file = replace(plain.file, mission=m.model_copy(update={"requirement": requirement}))
    figure = link_module.tornado(replace(plain, file=file), plain.tornados[0])
    assert texts(figure).count("required") == shown
    other = link_module.tornado(replace(plain, file=file), plain.tornados[1])
    assert "required" not in texts(other)


# --------------------------------------------------------------------------------------- figures of the links, whole
def a_swing(key, value, unit, low, high, margins, kind="paper"):
    return SimpleNamespace(
        key=key,
        value=value,
        unit=unit,
        low=low,
        high=high,
        margin_low_db=margins[0],
        margin_high_db=margins[1],
        swing_db=abs(margins[1] - margins[0]) if all(map(math.isfinite, margins)) else math.inf,
        kind=kind,
    )


def tornado_of(name):
    swings = [
        a_swing("communication.receiver_bandwidth", 2.5e8, "Hz", 2.25e8, 2.75e8, (-math.inf, 4.5)),
        a_swing("communication.transmit_power", 5.0, "W", 4.5, 5.5, (2.5, 3.25), "assumption"),
        a_swing("channel.loss", -1.5, "dB", -2.0, -1.0, (3.5, 2.75)),
        a_swing("code.bit_error_ratio", 1e-6, "", 1e-7, 1e-5, (2.9, 3.1), "assumption"),
    ]
    return SimpleNamespace(of=name, margin_db=3.0, swings=swings)


def links_of(of, *, jitter=None, required_db=3.0):
    requirement = SimpleNamespace(margin_db=required_db, outage=0.01, probability=0.99, quantile=0.99)
    mission = SimpleNamespace(requirement=requirement, jitter=jitter)
    return SimpleNamespace(file=SimpleNamespace(mission=mission), communication=SimpleNamespace(name=of))


def test_a_tornado_with_an_input_without_a_link_as_a_whole(plain):
    data, beacon = (t.of for t in plain.tornados[:2])
    assert figure_of(link_module.tornado(links_of(data), tornado_of(data))) == [
        "tornado",
        "What moves the margin",
        (
            "Margin with one input at a time 10 % lower and higher, all others as they are. An "
            "input in decibels is moved by 0.5 dB; a bit error ratio or an outage becomes ten "
            "times smaller and larger. No input leaves its bounds. Assumptions among them: "
            "communication.transmit_power, code.bit_error_ratio."
        ),
        {
            "input": [
                "communication.receiver_bandwidth",
                "communication.transmit_power",
                "channel.loss",
                "code.bit_error_ratio",
            ],
            "SI unit": ["Hz", "W", "dB", ""],
            "margin lower (dB)": ["-inf", 2.5, 3.5, 2.9],
            "margin higher (dB)": [4.5, 3.25, 2.75, 3.1],
            "value (SI)": [250000000.0, 5.0, -1.5, 1e-06],
            "lower (SI)": [225000000.0, 4.5, -2.0, 1e-07],
            "higher (SI)": [275000000.0, 5.5, -1.0, 1e-05],
        },
        "Sheet width=6.4 height=1.98",
        "Panel 0 0 x=<title=margin of the communication link (dB)> y=<low=3.6 high=-0.6 ticks={0:",
        "  receiver_bandwidth = 250 MHz, 1: transmit_power = 5 W, 2: channel.loss = -1.5 dB, 3:",
        ("  code.bit_error_ratio = 1e-06} grid=False size=8> legend=<place=lower right only=[<rings=[]"),
        "  colour=#E69F00 label=input lower> <rings=[] colour=#0072B2 label=input higher>]>",
        "Bars at=[0] start=[3] end=[0.75] breadth=[0.7] colour=#E69F00",
        "Bars at=[0] start=[3] end=[4.5] breadth=[0.7] colour=#0072B2",
        "Words text= x=1 y=0 colour=#777777 shift=[5 0] of_panel=x",
        "Bars at=[1] start=[3] end=[2.5] breadth=[0.7] colour=#E69F00",
        "Bars at=[1] start=[3] end=[3.25] breadth=[0.7] colour=#0072B2",
        "Words text= x=1 y=1 colour=#777777 shift=[5 0] of_panel=x",
        "Bars at=[2] start=[3] end=[3.5] breadth=[0.7] colour=#E69F00",
        "Bars at=[2] start=[3] end=[2.75] breadth=[0.7] colour=#0072B2",
        "Words text= x=1 y=2 colour=#777777 shift=[5 0] of_panel=x",
        "Bars at=[3] start=[3] end=[2.9] breadth=[0.7] colour=#E69F00",
        "Bars at=[3] start=[3] end=[3.1] breadth=[0.7] colour=#0072B2",
        "Words text= x=1 y=3 colour=#777777 shift=[5 0] of_panel=x",
        "Rule at=3 upright=True width=0.8",
        "Words text=< no margin: receiver too slow x=0.75 y=0 shift=[3 0]",
        "Rule at=3 upright=True colour=#D55E00 dash=--",
        "Words text=required x=3 y=-0.55 colour=#D55E00 base=bottom shift=[3 0]",
    ]
    other = figure_of(link_module.tornado(links_of(data), tornado_of(beacon)))
    assert other[:2] == ["tornado-beacon", "What moves the margin of the beacon"]
    assert not any("required" in str(line) for line in other[4:])


def test_wide_beacon_and_scan_are_drawn_with_their_own_times():
    scan = SimpleNamespace(coverage=0.9, detection_s=0.002, beam_radius_rad=2.5e-5, overlap=0.15, jitter_rms_rad=3e-6)
    mission = SimpleNamespace(acquisition=SimpleNamespace(scan=scan))
    found = SimpleNamespace(sigma_rad=1.25e-4, scanned=SimpleNamespace(half_angle_rad=4e-5))
    t = SimpleNamespace(
        sigma_rad=np.array([5e-5, 1e-4, 2e-4]),
        wide_time_s=np.array([0.1, 1.6, 25.6]),
        wide_probability=np.array([0.9, 0.91, 0.92]),
        scan_time_s=np.array([2.0, 8.0, 32.0]),
        scan_mean_time_s=np.array([1.0, 4.5, 17.0]),
        scan_probability=np.array([0.875, 0.95, 0.99]),
    )
    study = SimpleNamespace(file=SimpleNamespace(mission=mission))
    assert figure_of(link_module.trade(study, found, t)) == [
        "wide-beam-or-scan",
        "Wide beacon or scan",
        (
            "Time to be found at 90 % coverage, without settling and light time. The beacon's "
            "power, spread over a cone that covers the uncertainty, makes the partner's sensor "
            "integrate with the fourth power of it (noise that does not depend on the light; "
            "at least 2 ms); the same power in a beam of 40 µrad half angle at 1/e2, used out "
            "to 25 µrad and led over it with an overlap of 0.15 under 3 µrad of jitter per "
            "axis, takes a time that grows with its square and finds 87.5 % or more."
        ),
        {
            "uncertainty per axis (rad)": [5e-05, 0.0001, 0.0002],
            "wide beacon, time (s)": [0.1, 1.6, 25.6],
            "wide beacon, probability": [0.9, 0.91, 0.92],
            "scan, whole time (s)": [2.0, 8.0, 32.0],
            "scan, mean time (s)": [1.0, 4.5, 17.0],
            "scan, probability": [0.875, 0.95, 0.99],
        },
        "Sheet width=6.4 height=3.6",
        ("Panel 0 0 x=<title=pointing uncertainty, rms per axis (µrad) log=True ticks=[30 100 300 1000]>"),
        "  y=<title=time (s) log=True> legend=<place=upper left>",
        ("Line x=[50 100 200] y=[0.1 1.6 25.6] colour=#0072B2 label=wide beacon: detection at the edge of"),
        "  its cone",
        "Line x=[50 100 200] y=[2 8 32] colour=#E69F00 dash=-- label=spiral scan: whole area",
        "Line x=[50 100 200] y=[1 4.5 17] colour=#E69F00 dash=: label=spiral scan: mean until found",
        "Rule at=125 upright=True colour=#D55E00",
        "Words text=this mission x=125 y=32 colour=#D55E00 base=top shift=[3 0]",
    ]


def test_an_interleaver_is_drawn_with_what_it_costs_at_each_span():
    mission = SimpleNamespace(requirement=SimpleNamespace(margin_db=1.5))
    f = fading_of(curve=SimpleNamespace(span_s=(0.0, 0.002, 0.01, 0.1), penalty_db=(6.0, math.inf, 2.0, 1.25)))
    assert figure_of(link_module.interleaver(SimpleNamespace(file=SimpleNamespace(mission=mission)), f)) == [
        "interleaver",
        "What an interleaver brings",
        (
            "Extra power that brings the mean bit error ratio back to 10⁻⁶ under a series, "
            "over constant power, with LDPC. A span that is long against the fades lets each "
            "code word see all powers that there are. A span without a point costs more than "
            "any power makes up for."
        ),
        {"span (s)": [0.0, 0.002, 0.01, 0.1], "power that the fades cost (dB)": [6.0, "inf", 2.0, 1.25]},
        "Sheet width=6.4 height=3.4 legend=<place=above columns=2>",
        ("Panel 0 0 x=<title=span of the interleaver (ms) log=True> y=<title=power that the fades cost"),
        "  (dB)>",
        "Line x=[2 10 100] y=[nan 2 1.25] colour=#0072B2 label=with an interleaver marker=o size=4",
        "Rule at=6 upright=False colour=#E69F00 dash=-- label=without one",
        "Rule at=3.5 upright=False colour=#D55E00 dash=: label=what the margin can spare",
        "Line x=[10] y=[2] dash= label=this mission marker=D size=7",
    ]


# ------------------------------------------------------------------------------------ views of numbers that are made up
def a_way_to_find(name, k, possible=True):
    """A way of two stages and a run of two transitions, each number unlike others."""
    stages = [
        SimpleNamespace(
            name=f"s{j}", longest_s=2.0 * j + k, success_probability=0.9 - j / 8 - k / 64, on_failure=f"f{j}"
        )
        for j in (1, 2)
    ]
    log = [SimpleNamespace(stage=f"s{j}", to=f"t{j}", cause=f"c{j}", time_s=1.5 * j + k) for j in (1, 2)]
    return SimpleNamespace(
        name=name,
        stages=stages,
        log=log,
        possible=possible,
        outcome=SimpleNamespace(success_probability=0.96875 - k / 32, mean_time_s=12.5 + k),
        early_s=80.0 + k if possible else math.nan,
        simulated_probability=0.9375 - k / 32,
        simulated_mean_s=13.5 + k if possible else math.nan,
        simulated=SimpleNamespace(locked=np.array([possible, False, possible])),
    )


def a_finding(**scan):
    given = {
        "radius_rad": 4.5678e-4, "half_angle_rad": 7.5e-5, "duration_s": 33.0, "stated_detection_s": 0.02,
        "needed_detection_s": 0.015, "detects": True,
    }  # fmt: skip
    chances = SimpleNamespace(
        beacon_coverage=0.98765, answer_coverage=0.87654, answer_detection=0.76543, return_coverage=0.65432
    )
    return SimpleNamespace(
        chances=chances,
        sigma_rad=1.2345e-4,
        beacon_radius_rad=3.4567e-4,
        ways=[a_way_to_find("wide beacon", 0), a_way_to_find("scan", 1, possible=False)],
        scanned=SimpleNamespace(**given | scan) if scan is not None else None,
    )


def test_two_ways_to_find_the_partner_have_each_ones_own_numbers_stages_and_run():
    pictures = [
        SimpleNamespace(name=name, title=f"of {name}") for name in ("tornado-a", links_words.INTERLEAVER, "trade")
    ]
    found = a_finding(needed_detection_s=0.03)
    view = links.acquisition_view(found, pictures)
    assert outline(view) == one_text("""
# Acquisition
Exact sums over all orders of failures beside a seeded simulation of the same process. The wide beacon covers its
  partner with a probability of 0.9877 (its power suffices out to 346 µrad off axis), the answer lands with 0.8765
  and is seen with 0.7654, the narrow beam back lands with 0.6543. The random part of the pointing error is drawn
  anew at each attempt; biases stand at their bounds.
The scan covers 457 µrad about the predicted direction, for an uncertainty of 123 µrad rms per axis with biases, in
  33 s at most. At the edge of its beam the partner's sensor needs 30 ms in place of the 20 ms that are stated; the
  scan waits.
| -: way / lock / simulated / mean time / simulated / 90 % within [0]
wide beacon / 0.9688 / 0.9375 / 12.5 s / 13.5 s / 80 s
scan / never / 0.9062 / – / none locks / –
# Stages of the wide beacon, and one simulated run (folded)
| -: stage / at most / succeeds / else back to [0, 3]
s1 / 2 s / 0.7750 / f1
s2 / 4 s / 0.6500 / f2
| One simulated run: stage / goes to / cause / time [0, 1, 2]
s1 / t1 / c1 / 1.500 s
s2 / t2 / c2 / 3.000 s
# Stages of the scan, and one simulated run (folded)
| -: stage / at most / succeeds / else back to [0, 3]
s1 / 3 s / 0.7594 / f1
s2 / 5 s / 0.6344 / f2
| One simulated run: stage / goes to / cause / time [0, 1, 2]
s1 / t1 / c1 / 2.500 s
s2 / t2 / c2 / 4.000 s
# of trade (folded)
[trade]
""")
    assert [each.listed for each in view.views] == [False, False, False]
    assert rounded(links_numbers.finding_data(found)) == {
        "uncertainty_per_axis_rad": 1.2345e-4,
        "beacon_coverage": 0.98765,
        "answer_coverage": 0.87654,
        "answer_detection": 0.76543,
        "return_coverage": 0.65432,
        "scan_s": 33.0,
        "scan_radius_rad": 4.5678e-4,
        "scan_half_angle_rad": 7.5e-5,
        "scan_stated_detection_s": 0.02,
        "scan_needed_detection_s": 0.03,
        "ways": [
            {
                "name": name,
                "success_probability": 0.96875 - k / 32,
                "mean_time_s": None if k else 12.5,
                "simulated_success_probability": 0.9375 - k / 32,
                "simulated_mean_time_s": None if k else 13.5,
                "runs": 3,
                "stages": [
                    {"name": f"s{j}", "longest_s": 2.0 * j + k, "success_probability": 0.9 - j / 8 - k / 64}
                    for j in (1, 2)
                ],
            }
            for k, name in enumerate(("wide beacon", "scan"))
        ],
    }


@pytest.mark.parametrize(
    ("needed_s", "detects", "said"),
    [
        (0.015, True, ", in 33 s at most."),
        (0.02, True, ", in 33 s at most."),
        (
            0.021,
            True,
            (
                ", in 33 s at most. At the edge of its beam the partner's sensor needs 21 ms in place of the 20 "
                "ms that are stated; the scan waits."
            ),
        ),
        (
            5e9,
            False,
            (
                ". It detects nothing: at the edge of its beam the partner's sensor would need more than "
                "1000000 s in place of the 20 ms that are stated."
            ),
        ),
    ],
)
def test_a_scan_waits_where_its_light_needs_longer_than_is_stated(needed_s, detects, said):
    begin = (
        "The scan covers 457 µrad about the predicted direction, for an uncertainty of 123 µrad rms per "
        "axis with biases"
    )
    of = a_finding(needed_detection_s=needed_s, detects=detects)
    assert links.scan_words(of.scanned, of.sigma_rad) == begin + said.replace(
        "1000000 s", quantity(LONGEST_LOOK_S, "s")
    )
    data = links_numbers.finding_data(of)
    assert (data["scan_s"], data["scan_needed_detection_s"]) == ((33.0, needed_s) if detects else (None, None))


def a_pointing(reading=True):
    """Two errors, two totals, and a beacon that covers one of them."""
    made = [Line(f"error {k}", 1e-5 * k, "rad", f"basis {k}", f"source {k}", f"regime {k}") for k in (1, 2)]
    sums = [
        SimpleNamespace(
            name=f"rule {k}",
            rule=f"r{k}",
            total_rad=3e-5 * k,
            of=f"of {k}",
            formula=f"f {k}",
            authority=f"a {k}",
            caveat=f"c {k}",
        )
        for k in (1, 2)
    ]
    allowed = {"rss": ("", 4.5e-5), "ecss-radial": ("more than all", 0.0)}
    own, other = (
        SimpleNamespace(
            convention=f"angle {k}",
            half_angle_rad=4.4444e-5 * k,
            coverage=0.98765 / k,
            covers=k == 1,
            confident_divergence_rad=1.2345e-4,
        )
        for k in (1, 2)
    )
    return SimpleNamespace(
        lines=made,
        variance_shares=(0.125, 0.875),
        summations=sums,
        confidence=0.9973,
        reading=own if reading else None,
        counter_reading=other if reading else None,
        allocation=lambda half, rule: [
            SimpleNamespace(name=f"error {k}", note=allowed[rule][0], largest_rad=allowed[rule][1] * k, missing_rad=0.0)
            for k in (1, 2)
        ],
    )


def test_open_loop_errors_have_what_they_may_be_and_totals_with_what_the_beacon_covers():
    assert outline(links.pointing_view(a_pointing())) == one_text("""
# Open-loop pointing
| -: error source / half width / share of squares / largest allowed / largest allowed,; ECSS / how it counts /
  source [0, 5, 6] brief [0, 1, 2, 3, 5, 6]
error 1 / 10 µrad / 12.5 % / 45 µrad / nothing / basis 1 / source 1
error 2 / 20 µrad / 87.5 % / 90 µrad / nothing / basis 2 / source 2
Largest allowed: the half width at which the root sum square, or the total of ECSS for two axes, equals the beacon's
  half angle (44.4 µrad), with all other errors as they are.
| Totals at 99.73 %: rule 1 30 µrad; rule 2 60 µrad: total / value / beacon's half angle / of / formula / where it
  is authorised / what speaks against it here [0, 2, 3, 4, 5, 6]
rule 1 / 30 µrad / covers it, 14.4 µrad left / of 1 / f 1 / a 1 / c 1
rule 2 / 60 µrad / 15.6 µrad short / of 2 / f 2 / a 2 / c 2
Read as angle 1, the beacon's half angle is 44.4 µrad, at least the root sum square of one axis. It covers the
  partner with a probability of 0.9877; both axes and their biases are counted. 99.73 % would take a divergence of
  123 µrad. Read as angle 2, the half angle is 88.9 µrad and the probability 0.4938.
""")


def test_open_loop_errors_without_a_beacon_have_neither_what_they_may_be_nor_a_coverage():
    assert outline(links.pointing_view(a_pointing(reading=False))) == one_text("""
# Open-loop pointing
| -: error source / half width / share of squares / how it counts / source [0, 3, 4]
error 1 / 10 µrad / 12.5 % / basis 1 / source 1
error 2 / 20 µrad / 87.5 % / basis 2 / source 2
| Totals at 99.73 %: rule 1 30 µrad; rule 2 60 µrad: total / value / of / formula / where it is authorised / what
  speaks against it here [0, 2, 3, 4, 5]
rule 1 / 30 µrad / of 1 / f 1 / a 1 / c 1
rule 2 / 60 µrad / of 2 / f 2 / a 2 / c 2
""")


def a_performance(k, **changes):
    given = {
        "source": f"source {k}", "controller": f"c{k}", "mirror": "given",
        "jitter": SimpleNamespace(bias_rad=(3e-6 * k, 0.0), rms_rad=(0.0, 4e-6 * k)),
        "mean_loss_db": 0.125 * k, "outage_loss_db": 0.5 * k, "uncoded_penalty_db": 0.75 * k, "margin_db": 2.5 - k,
        "outage": 0.0125 * (k - 1), "short": 2e-4 * k, "data_rate_bit_s": 622.08e6 / k,
        "fades_per_s": math.nan, "fade_s": 0.001 * k, "fade_warning": "",
        "best": SimpleNamespace(half_angle_rad=1.5e-5 * k, at_limit=k == 2, current_excess_db=0.0625 * k),
    }  # fmt: skip
    return SimpleNamespace(**given | changes)


def test_the_link_under_four_pointing_errors_has_each_ones_numbers_and_what_hysteresis_costs():
    cases = [
        a_performance(1),
        a_performance(2, mirror="comparison", controller="c1"),
        a_performance(3, uncoded_penalty_db=math.inf),
    ]
    cases.append(a_performance(4, data_rate_bit_s=math.nan, uncoded_penalty_db=math.nan))
    costs = [
        SimpleNamespace(source="source 3", controller="c3", mirror="given", margin_db=-0.375, data_rate_bit_s=-51e6),
        SimpleNamespace(source="source 4", controller="c4", mirror="given", margin_db=0.004, data_rate_bit_s=math.nan),
    ]
    assert outline(links.performance_view(cases, costs, 0.003, ["said"], "c1")) == one_text("""
# What pointing costs the link
said
| The link under each of 4 pointing errors: pointing error from / controller / mirror / rms (µrad) / mean loss (dB)
  / loss at 0.3 % (dB) / penalty without a code (dB) / margin at 0.3 % (dB) / outage / below required margin / best
  half angle (µrad) / lost against it (dB) / data rate (Mbit/s) / hysteresis costs (dB) / and (Mbit/s) [0, 1, 2]
  best [0] brief [0, 1, 2, 3, 5, 7, 8]
source 1 / c1 / given / 5.00 / 0.12 / 0.50 / 0.75 / +1.50 / none / 2.0e-04 / 15.0 / 0.06 / 622 /  /
source 2 / c1 / comparison / 10.00 / 0.25 / 1.00 / 1.50 / +0.50 / 1.2 % / 4.0e-04 / 30.0* / 0.12 / 311 /  /
source 3 / c3 / given / 15.00 / 0.38 / 1.50 / beyond any power / −0.50 / 2.5 % / 6.0e-04 / 45.0 / 0.19 / 207 / 0.38
  / 51
source 4 / c4 / given / 20.00 / 0.50 / 2.00 / unknown / −1.50 / 3.8 % / 8.0e-04 / 60.0 / 0.25 / none / 0.00 /
Rms: radial, about zero. Penalty, the power that the errors cost: with a code the mean loss where its interleaver
  spans many fades, the loss at the outage where it spans none; without a code what brings the mean bit error ratio
  back to its target, in a Gaussian beam, unknown for a receiver that is given by its sensitivity alone. Outage:
  share of the time with a margin below 0 dB. Best half angle: of a Gaussian beam, at 1/e2, with the most power at
  the error of that column; a star: the present one, since a narrower one would take a larger aperture. Data rate:
  the largest with the required margin at that loss. What hysteresis costs: against the same controller and the same
  errors on a mirror without it.
""")
    three = links.performance_table(cases[:3], (), 0.003)
    assert (three.folded, len(three.headings), three.best) == ("", 13, [])


@pytest.mark.parametrize(
    ("per_s", "said"),
    [
        ([math.nan], []),
        (
            [1e-9, math.nan, 0.0],
            ["Fades below the required margin: less than one a year, for Gaussian errors of these spectra."],
        ),
        (
            [2346.0],
            [
                (
                    "Fades below the required margin, for Gaussian errors of that rms and spectrum: c1: 2350 a "
                    "second of 1 ms each."
                ),
                "Warned 1.",
            ],
        ),
        (
            [2.5, 1e-9, math.nan],
            [
                (
                    "Fades below the required margin, for Gaussian errors of that rms and spectrum: c1: 2.5 a "
                    "second of 1 ms each; c2: less than one a year."
                ),
                "Warned 1.",
            ],
        ),
        (
            [1e-9, 40.0],
            [
                (
                    "Fades below the required margin, for Gaussian errors of that rms and spectrum: c1: less than "
                    "one a year; c2: 40 a second of 2 ms each."
                ),
                "Warned 1.",
            ],
        ),
    ],
)
def test_fades_are_told_of_the_cases_whose_spectrum_is_known_with_one_doubt(per_s, said):
    cases = [a_performance(k, fades_per_s=each, fade_warning=f"warned {k}") for k, each in enumerate(per_s, 1)]
    assert links.fade_sentences(cases) == said


@pytest.mark.parametrize(
    ("ends", "said"),
    [
        ((1.23456, 2.34567, False, False), "from 1.235 m to 2.346 m"),
        ((1.23456, 2.34567, True, False), "up to 2.346 m"),
        ((1.23456, 2.34567, False, True), "from 1.235 m on"),
        ((1.23456, 2.34567, True, True), "wherever it was looked at"),
    ],
)
def test_a_span_of_a_solved_key_has_four_digits_at_the_ends_that_it_has(ends, said):
    low, high, low_open, high_open = ends
    of = SimpleNamespace(low=low, high=high, low_open=low_open, high_open=high_open)
    assert links_words._span(of, "m") == said


def test_an_input_of_a_tornado_is_told_with_three_digits_and_without_its_table():
    assert link_module._label(SimpleNamespace(key="communication.a.b", value=1234.56, unit="W")) == "a.b = 1.23 kW"
    assert (
        link_module._label(SimpleNamespace(key="channel.loss", value=-1.2345, unit="dB")) == "channel.loss = -1.23 dB"
    )


def test_light_on_a_tracking_sensor_has_its_angle_where_there_is_one():
    line = Line("read-out", 2e-9, "W", "b", "s", "r", "w")
    of = Tracking(3e-9, 7.5, (line,), replace(line, name="angle", value=4e-7, unit="rad"))
    told = {
        "name": "read-out",
        "value": 2e-9,
        "unit": "W",
        "basis": "b",
        "source": "s",
        "holds_for": "r",
        "warning": "w",
    }
    base = {"power_w": 3e-9, "signal_to_noise": 7.5, "lines": [told]}
    assert links_numbers._tracking(of) == {**base, "noise_equivalent_angle_rad": 4e-7}
    assert links_numbers._tracking(replace(of, noise_equivalent_angle=None)) == {
        **base,
        "noise_equivalent_angle_rad": None,
    }


def test_a_verdict_names_each_requirement_that_is_missed_and_none_where_a_link_does_not_close(plain, monkeypatch):
    asked = [
        Requirement("beacon", "beacon coverage", "%", 99.0, 90.0, -9.0, "the cone"),
        Requirement("answer", "answer margin", "dB", 3.0, 4.0, 1.0, "power"),
        Requirement("communication", "communication margin", "dB", 3.0, 9.0, 6.0, "power", unknown="an aperture"),
    ]
    monkeypatch.setattr(links_words, "of_links", lambda study: asked)
    margins = (3.25, -0.5, 12.0)
    budgets = [
        SimpleNamespace(name=name, margin_db=db)
        for name, db in zip(("Communication", "Beacon", "Answer"), margins, strict=True)
    ]
    told = "communication +3.25 dB, beacon \u22120.50 dB, answer +12.00 dB."
    study = SimpleNamespace(budgets=budgets, file=plain.file, closes=True)
    missed = "beacon coverage and communication margin"
    assert links_words.verdict(study) == f"Not every requirement is met: {missed}; {told}"
    del asked[0]
    assert links_words.verdict(study) == f"Not every requirement is met: communication margin; {told}"
    assert links_words.verdict(SimpleNamespace(**{**vars(study), "closes": False})) == f"The links do not close: {told}"


def test_two_budgets_have_the_totals_of_the_first_and_then_those_that_only_the_second_has():
    def line(name, value, basis="b", source="s", regime="r", warning=""):
        return Line(name, value, "dB", basis, source, regime, warning)

    one = SimpleNamespace(
        name="Answer",
        lines=(line("Gain", 3.0), line("Loss", -1.0, regime="far", warning="near")),
        totals=(line("Sum", 2.0), line("Left", 0.5)),
        margin_db=0.5,
    )
    two = SimpleNamespace(
        name="Answer",
        lines=(line("Gain", 4.0, source="t"), line("Loss", -2.0, basis="c", warning="near")),
        totals=(line("More", 7.0), line("Sum", 2.5, basis="d")),
        margin_db=-7.0,
    )
    (table,) = paired_tables(one, two, NAMES)
    assert [tuple(map(str, row)) for row in table.rows] == [
        ("Gain", "3.00 dB", "4.00 dB", "b", "s\nsimulated: t", "r"),
        ("Loss !", "\u22121.00 dB", "\u22122.00 dB", "b\nsimulated: c", "s", "far\nsimulated: r"),
        ("Sum", "2.00 dB", "2.50 dB", "b\nsimulated: d", "s", "r"),
        ("Left", "0.50 dB", "", "b", "s", "r"),
        ("More", "", "7.00 dB", "b", "s", "r"),
    ]
    assert (table.rows[1][0].mark, table.rows[1][0].hint) == ("!", "near")
    assert (table.totals, table.title, table.headings) == (
        3,
        "Answer",
        ("line", *NAMES, "basis", "source", "holds for"),
    )
    assert table.folded == "Answer: margin 0.50 dB as budgeted, \u22127.00 dB simulated"
    names = ["lines.Gain", "lines.Loss", "totals.Sum", "totals.Left", "totals.More"]
    for column in (1, 2):
        assert [table.name(row, column) for row in range(5)] == [f"budgets.Answer.{name}.value" for name in names]


def test_the_first_doubt_of_fades_is_told_and_a_case_without_a_controller_by_its_source():
    def fades(source, controller, warning, per_s=3.0):
        return SimpleNamespace(
            source=source, controller=controller, fade_warning=warning, fades_per_s=per_s, fade_s=2e-3
        )

    cases = [
        fades("a file", "", "", math.nan),
        fades("the jitter", "", ""),
        fades("the loop", "PI", "too few samples"),
        fades("the loop", "PID", "another"),
    ]
    each = "3 a second of 2 ms each"
    assert fade_sentences(cases) == [
        "Fades below the required margin, for Gaussian errors of that rms and spectrum: "
        f"the jitter: {each}; PI: {each}; PID: {each}.",
        "Too few samples.",
    ]
    assert fade_sentences(cases[:2])[1:] == []


def test_a_page_of_links_has_what_was_solved_for_ahead_of_the_budgets_and_a_standard_behind_them(plain, monkeypatch):
    of_figures = []
    monkeypatch.setattr(link_module, "link_figures", lambda study: [SimpleNamespace(static="a static picture")])

    def views(study, figures):
        of_figures.append((study, figures))
        return (View("Link budgets", ["the budgets"]),)

    monkeypatch.setattr(links, "links_views", views)
    monkeypatch.setattr(links, "standard_view", lambda against: View(f"Held against {against}", ["each clause"]))
    solved = variation.Solved((CLOSED,), (1.0, 5.0), 3.0, 7.0)
    solution = link_study.Solution("answer.power", "W", "answer", 3.0, solved, 2.0, None)
    said = links_words.solution_text(solution)
    for given, has in (((), (0, 0)), ((solution,), (1, 0)), ((None, "a standard"), (0, 1)), ((solution, "a"), (1, 1))):
        page = without_scripts(links_page(plain, *given))
        assert (page.count(said), page.count("each clause")) == has
        places = [page.index(each) for each in (said, "the budgets", "each clause") if each in page]
        assert places == sorted(places) and len(places) == 1 + sum(has)
    assert of_figures == [(plain, ["a static picture"])] * 4


@pytest.mark.parametrize(
    ("rate_bit_s", "said"),
    [
        (622.4e6, "622"),
        (-622.4e6, "\u2212622"),
        (10.4e6, "10"),
        (9.96e6, "10"),
        (-9.94e6, "\u22129.9"),
        (1.25e6, "1.2"),
        (-125e3, "\u22120.12"),
        (0.0, "0"),
    ],
)
def test_a_rate_is_whole_from_ten_megabits_on_whichever_its_sign(rate_bit_s, said):
    assert links._mbit_s(rate_bit_s) == said


def test_the_data_have_the_tornado_of_each_beam_behind_that_of_communication(plain):
    own, *others = plain.tornados
    data = links_data(plain)
    assert [(each["of"], each["margin_db"]) for each in data["other_tornados"]] == [
        (budget.name, pytest.approx(budget.margin_db)) for budget in plain.budgets[1:]
    ]
    assert [each.of for each in others] == ["Beacon", "Answer"]
    for made, of in zip(
        (data["tornado"], *(each["tornado"] for each in data["other_tornados"])), plain.tornados, strict=True
    ):
        assert made == [
            {
                "input": s.key,
                "unit": s.unit,
                "value": s.value,
                "low": s.low,
                "high": s.high,
                "margin_low_db": s.margin_low_db,
                "margin_high_db": s.margin_high_db,
                "source": s.source,
            }
            for s in of.swings
        ]
    assert own.of == "Communication"
