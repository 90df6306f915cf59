"""The report: whole or absent, self-contained, with its numbers and their origin in files."""

import csv
import hashlib
import html
import json
import math
import re
import xml.etree.ElementTree as ET
from dataclasses import replace
from html.parser import HTMLParser
from types import SimpleNamespace

import numpy as np
import pytest
import xarray as xr

from drawn import figure_of, one_text, outline
from microrad import report
from microrad.core import folder, machine
from microrad.link.budget.lines import FREE_SPACE_LOSS
from microrad.link.requirement import Requirement
from microrad.loop.paper_cases import PID, PID_WITH_INVERSE
from microrad.mirror import Variant
from microrad.mission import file as missionfile
from microrad.mission.model import Source
from microrad.report.data import finite
from microrad.report.page import templates as scripts
from microrad.report.page.templates import inputs_view
from microrad.report.paper import bench
from microrad.report.paper import diagrams as drawings
from microrad.report.paper import figures as paper_figures
from microrad.report.paper import page as paper_views
from microrad.report.plotting.figure import Figure
from microrad.report.plotting.sheet import Line, Panel, Rule
from microrad.report.quantities import minus
from microrad.report.requirements import nearest, nearness
from microrad.report.results import arrays
from microrad.report.study import chain, page, words
from microrad.report.study import contributors as requirement_views
from microrad.report.study import data as study_data
from microrad.report.tables import Table
from microrad.report.view import Verbatim
from microrad.study import study
from microrad.study.pointing_penalty import Cost
from places import ROOT
from report_pages import assert_sound
from shipped import SHIPPED, edited_file, plain_drawn, plain_study


@pytest.fixture(scope="module", autouse=True)
def no_fine_pointing():
    """The fine-pointing loop has tests of its own and takes the longest."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(study.controller_study, "design_and_simulate", lambda *args, **more: None)
        yield


@pytest.fixture(scope="module")
def paper():
    return plain_study()


@pytest.fixture(scope="module")
def written(paper, tmp_path_factory):
    target = tmp_path_factory.mktemp("report") / "study"
    assert report.write(paper, target) == target / "report.html"
    return target


@pytest.fixture
def no_numbers(monkeypatch):
    """A folder without what `results.nc` holds, which `written` has, and which takes a second."""
    monkeypatch.setattr(arrays, "study_netcdf", lambda study: b"")


class Links(HTMLParser):
    """Everything a page would load or link to, its anchors, and its text outside scripts, styles apart."""

    def __init__(self):
        super().__init__()
        self.found, self.ids, self.text, self.styles, self.inside = [], [], [], [], ""

    def handle_starttag(self, tag, attrs):
        self.inside = tag
        names = {"src", "href", "xlink:href", "data", "action", "poster", "srcset"}
        self.found += [value for name, value in attrs if name in names]
        self.ids += [value for name, value in attrs if name == "id"]

    def handle_endtag(self, tag):
        self.inside = ""

    def handle_data(self, data):
        if self.inside == "style":
            self.styles.append(data)
        elif self.inside != "script":
            self.text.append(data)


def parsed(text):
    links = Links()
    links.feed(text)
    return links


@pytest.mark.promise("decisions-1", "report-2", "report-3")
def test_the_page_loads_nothing(written):
    text = (written / "report.html").read_text(encoding="utf-8")
    links = parsed(text)
    assert_sound(text)
    own = ("#", "data:image/png;base64,", "figures/")
    assert [link for link in links.found if not link.startswith(own)] == []
    assert all((written / link).is_file() for link in links.found if link.startswith("figures/"))
    styles = "".join(links.styles)
    assert len(styles) > 1000
    assert "@import" not in styles
    assert not re.search(r"url\((?!#)", styles)


@pytest.mark.promise("report-6")
def test_the_page_opens_with_the_verdict_and_keeps_its_order(written, paper):
    text = (written / "report.html").read_text(encoding="utf-8")
    links = parsed(text)
    visible = " ".join(links.text)
    visible = visible[visible.index("What the verdict rests on") :]  # behind the contents
    wanted = (
        "What the verdict rests on",
        "the weightiest first",
        "Each arrow hands a result on",
        "Link budgets",
        "What the link delivers",
        "Table 1  Past",
        "Table 2  Link budgets",
        "Fig. 1  Open-loop pointing",
        "Fig. 2  Link margin",
        "Fig. 3  Experiment",
        "Fig. 4  Identified linear dynamics",
        "Fig. 5  Hysteresis measured",
        "Fig. 6  PID",
        "Fig. 7  Feedforward",
        "Fig. 8  PID against",
        "Not in this study",
        "This page holds what made it",
    )
    places = [visible.index(each) for each in wanted]
    assert places == sorted(places)
    found = re.findall(r'<h2 id="([^"]+)">([^<]+)<a ', text)
    views = page.study_views(paper, plain_drawn())
    assert [html.unescape(title) for _, title in found] == [*(view.title for view in views), "Manifest"]
    contents = [link[1:] for link in links.found if link.startswith("#")]
    assert [anchor for anchor in contents if anchor in dict(found)][: len(found)] == [anchor for anchor, _ in found]
    assert all(links.ids.count(id) == 1 for id in (*contents, "figure-chain", "fig1-desc"))
    assert text.index('<h2 id="verdict">') < text.index('<h2 id="warnings">') < text.index('<h2 id="chain">')
    assert len(re.findall(r"<(?:h[1-6]|details class=.view.) id=", text)) >= 25
    assert text.count("<figure ") == len(re.findall('<figure [^>]*id="figure-', text))


@pytest.mark.promise("link-1")
def test_the_links_stand_in_the_report_with_what_the_residual_costs(written, paper):
    visible = " ".join(parsed((written / "report.html").read_text(encoding="utf-8")).text)
    for title in ("Open-loop pointing", "Communication", "Beacon", "Answer", "Acquisition", "What moves the margin"):
        assert title in visible, title
    begin = visible.index("What pointing costs the link")
    case = paper.performance.case("sine of 25 Hz", "PID + inverse", "given")
    for shown in (f"{case.mean_loss_db:.2f}", f"{case.outage_loss_db:.2f}", f"{case.margin_db:+.2f}"):
        assert shown in visible[begin:], shown


def test_a_warning_of_a_budget_stands_once_on_the_page(written, paper):
    text = html.unescape((written / "report.html").read_text(encoding="utf-8"))
    assert len(paper.links.warnings) == 3
    assert [text.count(f"<li>{each}</li>") for each in paper.links.warnings] == [1, 1, 1]
    assert text.count("What \u201c!\u201d marks in the tables stands under Warnings.") == 1


@pytest.mark.promise("report-6")
def test_what_limits_the_link_stands_below_the_verdict_and_a_warning_of_the_day_once(written, paper):
    text = html.unescape((written / "report.html").read_text(encoding="utf-8"))
    rests = text[text.index("What the verdict rests on:") : text.index('id="terms"')]
    assert [rests.count(f"<li>{each}</li>") for each in words.limits(paper)] == [1, 1]
    assert words.limits(paper)[1].startswith("What limits it is the ")
    assert paper.day.warnings and [text.count(f"<li>{each}</li>") for each in paper.day.warnings] == [1]


def test_terms_are_explained_below_the_verdict_and_stand_on_the_page(written):
    text = (written / "report.html").read_text(encoding="utf-8")
    begin = text.index('<details class="view" id="terms">')
    end = text.index("</details>", begin)
    assert text.index('<h2 id="verdict">') < begin < end < text.index('<h2 id="warnings">')
    for term, said in words.TERMS.items():
        assert html.escape(f"{term}: {said}").replace("&#x27;", "&#39;") in text[begin:end]
        assert term.lower().removesuffix(" at 1/e2") in (text[:begin] + text[end:]).lower()
    assert len(re.findall("<li>", text[begin:end])) == len(words.TERMS)


@pytest.mark.promise("report-6", "report-8")
def test_each_requirement_stands_with_its_margin_and_its_contributor(written, paper):
    rows = requirement_views.judged_table(paper, paper.requirements).rows
    assert [row[4].mark for row in rows] == ["derived", "PASS", "PASS", "FAIL", "FAIL"]
    for row, r in zip(rows, paper.requirements, strict=True):
        assert row[5].lower().startswith(r.limited_by.lower())
        assert row[3][0] == ("+" if r.met else "\u2212")
    cone, beacon, answer, residual, link = (row[5] for row in rows)
    shares = paper.open_loop.variance_shares
    widest = f"Body pointing: {100 * max(shares):.2g} % of the sum of squares, 300 µrad half width"
    assert cone == f"{widest}; the cone of 390 µrad half angle covers its partner with a probability of 0.53"
    for text, tornado in ((beacon, paper.links.tornados[-2]), (answer, paper.links.tornados[-1])):
        top = tornado.swings[0]
        assert text.endswith(f"the margin moves most with {top.key}: {top.swing_db:.2f} dB for ±10 %")
    straight = next(
        r for r in paper.runs if (r.mirror, r.controller, r.freq_hz) == ("no hysteresis", "PID + inverse", 25.0)
    )
    assert f"{paper.residual.trace.peak_rad * 1e6:.1f} µrad with hysteresis" in residual
    assert f"{straight.trace.peak_rad * 1e6:.1f} µrad without" in residual
    lost = next(line.value for line in paper.achieved.lines if line.name == "Pointing loss")
    assert f"pointing loss {-lost:.2f} dB; the margin moves most with {paper.tornado.swings[0].key}" in link
    visible = " ".join(parsed((written / "report.html").read_text(encoding="utf-8")).text)
    assert all(row[5] in visible for row in rows)


def test_half_of_the_power_is_further_off_than_an_error_of_nine_fifths():
    power = Requirement("communication", "margin", "dB", 3.0, 3.0 - 10.0 * math.log10(2.0), -10.0 * math.log10(2.0), "")
    error = Requirement("residual", "error", "rad", 10e-6, 18e-6, -8e-6, "")
    assert nearness(power)[2] == pytest.approx(0.5)
    assert nearness(error)[2] == pytest.approx(5.0 / 9.0)
    assert nearest((error, power)) is power
    assert nearest((replace(error, actual=21e-6, margin=-11e-6), power)) is not power


def test_a_requirement_moved_most_by_a_share_says_by_what_factor(paper):
    swing = replace(paper.links.tornados[0].swings[0], key="requirement.outage", margin_low_db=0.0, margin_high_db=9.0)
    beyond = replace(swing, margin_high_db=math.nan)
    level = replace(swing, key="channel.loss", unit="dB")
    said = requirement_views.most_sensitive
    assert (
        said([beyond, swing]) == "; the margin moves most with requirement.outage: 9.00 dB for ten times more or less"
    )
    assert said([level]).endswith("9.00 dB for ±0.5 dB")
    assert said([beyond]) == said([]) == ""
    assert "channel.loss" in said([level, replace(swing, margin_high_db=9.0 + 1e-12)])  # equal but for a rounding


@pytest.mark.promise("report-6")
def test_each_box_of_the_chain_holds_its_own_numbers(paper):
    boxes = {box.name: box for box in chain.stages(paper)}
    day = paper.day
    assert {name: box.lines for name, box in boxes.items()} == {
        "Orbit": (
            f"{len(day.relay.contacts)} contacts in 24 h",
            f"{day.relay.contact_s / 60.0:.0f} min in view of the relay",
            "42000 km, up to 44000 km",
            "point-ahead 71 µrad, corrected",
        ),
        "Link": (
            "300 Mbit/s with 5 W",
            "beam 19.7 µrad (half, 1/e²)",
            "margin +3.00 dB as budgeted,",
            "at 10 µrad off axis",
        ),
        "Pointing": ("open loop 390 µrad (rss)", "beacon's cone 390 µrad, covers 53.1 %", "fine: 10 µrad allowed"),
        "Mirror": ("reach 1.07 mrad over 12 V", "hysteresis 2.4 % at 1 Hz,", "14.0 % at 100 Hz"),
        "Loop": ("PID + inverse at 50 kHz", f"modulus margin {paper.margins.modulus:.2f}"),
        "Residual": ("12.1 µrad peak, 25 Hz sine", "allowed 10 µrad"),
        "Volume": (
            f"{day.relay.capacity_bit / 8e9:.0f} GB possible by the relay",
            f"{day.relay.arrived_bit / 8e9:.1f} GB of the instrument's",
            f"{day.direct.capacity_bit / 8e9:.1f} GB direct to ground",
        ),
        "Verdict": (
            "3 of 5 requirements met",
            f"link at the residual +{paper.achieved.margin_db:.2f} dB,",
            "3 dB required",
        ),
    }
    assert {name: box.mark for name, box in boxes.items() if box.mark} == {
        "Pointing": "derived",
        "Residual": "FAIL",
        "Verdict": "FAIL",
    }
    ahead = paper.file.mission.point_ahead.model_copy(update={"corrected": False})
    left = replace(paper.file, mission=paper.file.mission.model_copy(update={"point_ahead": ahead}))
    assert chain.stages(replace(paper, file=left, day=None))[0].lines == (
        "42000 km as budgeted",
        "point-ahead 71 µrad, NOT corrected",
    )


@pytest.mark.promise("report-6")
def test_the_chain_shows_the_numbers_of_the_study_in_its_boxes(written, paper):
    boxes = chain.stages(paper)
    assert [b.name for b in boxes] == ["Orbit", "Link", "Pointing", "Mirror", "Loop", "Residual", "Volume", "Verdict"]
    text = (written / "report.html").read_text(encoding="utf-8")
    shown = ET.fromstring(text[(start := text.index('<ol class="chain"')) : text.index("</ol>", start) + 5])
    assert [each.find("strong").text for each in shown] == [b.name for b in boxes]
    assert [tuple(line.text for line in each.iter("div")) for each in shown] == [b.lines for b in boxes]
    marks = [each.findtext("span", "") for each in shown]
    assert marks == [{"PASS": "✓ PASS", "FAIL": "✗ FAIL"}.get(b.mark, b.mark) for b in boxes]
    assert [each.get("class", "") for each in shown] == [b.mark for b in boxes]
    said = {b.name: " ".join(b.lines) for b in boxes}
    for name, needed in (
        ("Orbit", "15 contacts in 24 h"),
        ("Link", "300 Mbit/s with 5 W"),
        ("Link", "margin +3.00 dB as budgeted"),
        ("Residual", "12.1 µrad peak, 25 Hz sine"),
        ("Volume", f"{paper.day.relay.capacity_bit / 8e9:.0f} GB possible by the relay"),
        ("Verdict", "3 of 5 requirements met"),
    ):
        assert needed in said[name]
    assert marks[5] == marks[7] == "✗ FAIL"


@pytest.mark.promise("report-6")
def test_the_virtual_bench_stands_where_the_paper_measures(written, paper):
    found = bench.chirp()
    assert 96.9 <= found.fit_percent < 97.1
    visible = " ".join(parsed((written / "report.html").read_text(encoding="utf-8")).text)
    assert f"explains {found.fit_percent:.1f} % of it (the paper: about 97 %)" in visible
    for title in (
        "Fig. 4  Identified linear dynamics (virtual bench)",
        "Fig. 5  Hysteresis measured and modelled (virtual",
    ):
        assert title in visible
    assert [loop.freq_hz for loop in bench.loops()] == [60.0, 80.0, 100.0]
    assert {loop.fitted_hz for loop in bench.loops()} == {100.0}
    assert all(0.0 < loop.error_percent < 0.2 for loop in bench.loops())


def test_the_phase_of_the_bench_is_drawn_in_degrees():
    late = bench.chirp()
    of = replace(
        late, response=np.exp(-2j * np.pi * 1e-3 * late.freq_hz), model=np.exp(-2j * np.pi * late.freq_hz * 2e-3)
    )
    *_, phase = bench.chirp_figure(of).sheet.panels
    for line, delay_s in zip(phase.all_of(Line), (1e-3, 2e-3), strict=True):
        np.testing.assert_allclose(line.y, -360.0 * delay_s * late.freq_hz, atol=1e-6)


def test_the_margins_of_the_loop_are_in_decibels_and_degrees(paper):
    known = replace(paper.margins, gain_up=2.0, phase_rad=math.pi / 3.0)
    assert page._margins(replace(paper, margins=known))[:2] == [("gain margin", "6.0 dB"), ("phase margin", "60°")]


@pytest.mark.usefixtures("no_numbers")
def test_another_kind_of_mirror_leaves_the_bench_out(no_scan, tmp_path):
    other = study.run_study(edited_file(tmp_path, day=False))
    visible = " ".join(parsed(report.write(other, tmp_path / "out").read_text(encoding="utf-8")).text)
    assert not (tmp_path / "out" / "figures" / "fig4-chirp.csv").exists()
    assert "Fig. 4, what differs from the paper: Not drawn: the mission's mirror is not of the paper's kind" in visible


@pytest.mark.promise("report-6")
def test_table_2_sets_the_mission_beside_the_paper(written, paper):
    rows = {row[0]: row[1:] for row in paper_views.links_tables(paper)[0].rows}
    assert rows["Pointing accuracy"] == ("300 µrad", "300 µrad", "10 µrad", "10 µrad")
    assert rows["Strehl ratio"] == ("0.4 dB",) * 4
    assert rows["Margin"] == ("+", f"{paper.beacon.margin_db:.2f} dB", "+", f"{paper.communication.margin_db:.2f} dB")
    assert rows["Transmit power"] == ("4 W", "4 W", "5 W", "5 W")
    assert rows["Distance"] == ("44 000 km", "44000 km", "42 000 km", "42000 km")
    assert rows["GEO receive aperture"] == ("15 cm", "150 mm", "15 cm", "150 mm")
    assert paper_views.projects_table(paper).rows[-1] == ("", f"this mission: {paper.file.mission.name}", "", "300", "")


@pytest.mark.promise("report-6")
def test_each_figure_of_the_paper_is_the_one_of_ours_that_stands_for_it(paper):
    drawn = plain_drawn()
    found = {view.title: view for view in paper_views.paper_view(paper, (*drawn.study, *drawn.bench)).views}
    numbered = [title for title in found if title.startswith("Fig. ")]
    assert [title[:6] for title in numbered] == [f"Fig. {n}" for n in range(1, 9)]
    ours = {title[:6]: [b for b in found[title].blocks if isinstance(b, Figure)] for title in numbered}
    assert {number: [f.name for f in several] for number, several in ours.items() if several} == {
        "Fig. 2": ["fig2-margin-map"],
        "Fig. 4": ["fig4-chirp"],
        "Fig. 5": ["fig5-bench-loops", "fig5-hysteresis-loops"],
        "Fig. 6": ["fig6-pid"],
        "Fig. 8": ["fig8-inverse"],
    }
    judged = {title[:6]: [b.rows for b in found[title].blocks if isinstance(b, Table)] for title in numbered}
    assert {n: [row[0] for row in rows[0]] for n, rows in judged.items() if rows} == {
        "Fig. 2": ["section 2.2, Fig. 2"],
        "Fig. 5": ["Fig. 5"],
        "Fig. 6": ["Fig. 6", "section 3.1, Fig. 6 and 8"],
        "Fig. 8": ["Fig. 8", "Fig. 8", "section 3.1, Fig. 6 and 8"],
    }
    assert [*found][-2:] == ["Hysteresis models compared", "Where the paper's closed-loop claims hold"]
    assert all(figure.title.startswith(number) for number, several in ours.items() for figure in several)
    assert [n for n, several in ours.items() if several and "virtual bench" in several[0].title] == ["Fig. 4", "Fig. 5"]
    without = paper_views.paper_view(paper, drawn.study)
    (fourth,) = (view for view in without.views if view.title.startswith("Fig. 4"))
    assert [block.text.partition(": ")[2][:10] for block in fourth.blocks] == ["Not drawn:"]


@pytest.mark.promise("report-6")
def test_the_drawings_hold_the_numbers_of_mission_and_bench(paper):
    relay, p = drawings.relay(paper), paper.open_loop
    widths = {row["text"]: row["width"] for row in relay["errors"]}
    assert widths["root sum square 390 µrad"] == pytest.approx(200.0 * p.rss_rad / p.beacon_half_angle_rad)
    assert widths["cone of the beacon 390 µrad"] == pytest.approx(200.0)
    assert widths["Body pointing 300 µrad"] == pytest.approx(200.0 * 300e-6 / p.beacon_half_angle_rad)
    assert relay["sequence"] == [
        "wide beacon, 780 µrad",
        "answer, 40 µrad",
        "narrow beam back, point-ahead",
        "lock; 300 Mbit/s",
    ]
    assert (drawings.setup()["converter"], drawings.setup()["amplifier"]) == (
        ("Converters", "16 bits, 50 kHz"),
        ("Amplifier", "gain 15", "0 to 180 V"),
    )
    control = drawings.control(paper)
    assert control["pid"] == ("PID", "Kp 1 V/mrad", "Ki 16000 V/(mrad s)", "50 kHz, 20 µs late")
    assert control["plant"] == ("Mirror", "amplifier, 5 kHz", "hysteresis, Eq. 3", "linear part, Eq. 2")


def test_the_page_holds_what_the_paper_is_judged_by(written):
    text = (written / "report.html").read_text(encoding="utf-8")
    for needed in (
        "76",
        "291 photons per bit",
        "hence circular",
        "Homodyne BPSK",
        "18.1",
        "whose model first turns the wrong way",
    ):
        assert needed in text
    for claim in ("Fig. 5", "Fig. 6", "Fig. 8", "Table 2", "section 2.1", "section 3.2"):
        assert claim in text


@pytest.mark.promise("report-2")
def test_each_figure_is_an_svg_with_its_data(written):
    drawn = plain_drawn().every
    assert [f.name for f in drawn] == [
        "fig2-margin-map",
        "fig5-hysteresis-loops",
        "fig6-pid",
        "fig8-inverse",
        "comparison",
        "claims-scan",
        "fig4-chirp",
        "fig5-bench-loops",
        "tornado",
        "tornado-beacon",
        "tornado-answer",
        "wide-beam-or-scan",
        "day-timeline",
        "along-contact",
        "data-volume",
        "latency",
        "world-map",
        "assumptions",
    ]
    names = {p.name for p in (written / "figures").iterdir()}
    assert names == {f.name + ending for f in drawn for ending in (".svg", ".csv")}
    for figure in drawn:
        assert (written / "figures" / f"{figure.name}.svg").read_text(encoding="utf-8") == figure.svg
        with (written / "figures" / f"{figure.name}.csv").open(newline="", encoding="utf-8") as file:
            header, *rows = list(csv.reader(file))
        assert header == list(figure.columns)
        for place, column in enumerate(figure.columns.values()):
            kept = [row[place] for row in rows if row[place]]
            assert len(kept) == len(column)
            if isinstance(column, tuple):
                assert tuple(kept) == column
                continue
            np.testing.assert_allclose(np.array(kept, dtype=float), column, rtol=1e-8, atol=1e-18)


def test_the_map_shows_the_contours_with_their_labels_and_the_band_of_the_readings(written):
    svg = (written / "figures" / "fig2-margin-map.svg").read_text(encoding="utf-8")
    words = [each.text for each in ET.fromstring(svg).iter("{http://www.w3.org/2000/svg}text")]
    for needed in ("0 dB", "3 dB", "3 dB by other readings of the conventions", "budget: 300 Mbit/s at 10 \u00b5rad"):
        assert words.count(needed) == 1, needed
    assert "6 dB" not in words  # no other contour has a label


@pytest.mark.promise("report-2", "report-13")
def test_results_carry_units_and_the_numbers_of_the_study(written, paper):
    tree = xr.open_datatree(written / "results.nc", engine="h5netcdf")
    try:
        for node in tree.subtree:
            for variable in node.to_dataset(inherit=False).variables.values():
                assert variable.attrs["units"]
                assert variable.attrs["long_name"]
        margin = tree["margin_map"]["margin"]
        assert margin.attrs["units"] == "dB"
        np.testing.assert_array_equal(margin.values, paper.margin_map.margin_db)
        run = tree["tracking/given_pid_inverse_25_hz"]
        assert run.attrs["peak_error_rad"] == paper.residual.trace.peak_rad
        error = (run["reference"] - run["output"]).values[run.attrs["steady_from_sample"] :]
        assert np.max(np.abs(error)) == pytest.approx(paper.residual.trace.peak_rad, rel=1e-12)
        assert tree.attrs["mission_sha256"] == hashlib.sha256(SHIPPED.read_bytes()).hexdigest()
    finally:
        tree.close()


@pytest.mark.promise("decisions-1", "report-2", "report-6")
def test_the_manifest_names_mission_versions_and_every_file(written, paper):
    manifest = json.loads((written / "manifest.json").read_text(encoding="utf-8"))
    assert manifest["mission"]["text"] == SHIPPED.read_text(encoding="utf-8")
    assert manifest["mission"]["sha256"] == hashlib.sha256(SHIPPED.read_bytes()).hexdigest()
    assert {"python", "microrad", "numpy", "numba"} <= set(manifest["versions"])
    assert manifest["machine"] == machine.machine()
    drawn = "64 runs; seed 1 of [acquisition], 4000 runs; seed 1 of [operations], 20 runs; seed 1 of the virtual bench"
    assert drawn in manifest["randomness"]
    shown = " ".join(parsed((written / "report.html").read_text(encoding="utf-8")).text).rpartition(
        "This page holds what"
    )[2]
    for said in (manifest["mission"]["sha256"], drawn, f"numpy {manifest['versions']['numpy']}", "processor: "):
        assert said in shown
    assert manifest["summary"]["margin_db"]["communication_at_residual"] == paper.achieved.margin_db
    files = {str(p.relative_to(written)): p for p in written.rglob("*") if p.is_file() and p.name != "manifest.json"}
    assert set(manifest["files_sha256"]) == set(files)
    for name, path in files.items():
        assert manifest["files_sha256"][name] == hashlib.sha256(path.read_bytes()).hexdigest()


@pytest.mark.promise("report-3")
@pytest.mark.usefixtures("no_numbers")
def test_two_runs_write_the_same_page_and_figures(paper, written, tmp_path):
    """The first one's figures may be another process's."""
    report.write(paper, tmp_path / "again")
    for path in [written / "report.html", *(written / "figures").iterdir()]:
        assert (tmp_path / "again" / path.relative_to(written)).read_bytes() == path.read_bytes()


@pytest.mark.promise("report-1", "report-22")
@pytest.mark.usefixtures("no_numbers")
def test_results_are_never_replaced_silently(paper, tmp_path, monkeypatch):
    monkeypatch.setattr(report, "study_figures", lambda *args: page.StudyFigures())
    target = tmp_path / "out"
    report.write(paper, target)
    before = {p: p.read_bytes() for p in target.rglob("*") if p.is_file()}
    with pytest.raises(report.FolderError, match="already holds results: choose another --output, or replace"):
        report.write(paper, target)
    assert {p: p.read_bytes() for p in target.rglob("*") if p.is_file()} == before
    (target / "left over.txt").write_text("x")
    report.write(paper, target, overwrite=True)
    assert not (target / "left over.txt").exists()
    assert sorted(p.name for p in tmp_path.iterdir()) == ["out"]


@pytest.mark.promise("report-1", "report-22")
@pytest.mark.parametrize("manifest", [None, "{}", "not JSON", '{"versions": {"other": "1"}}', '{"versions": 3}'])
def test_a_folder_of_others_is_never_replaced(tmp_path, manifest):
    (tmp_path / "thesis.txt").write_text("years of work")
    if manifest is not None:
        (tmp_path / "manifest.json").write_text(manifest)
    with pytest.raises(report.FolderError, match="not results of microrad"):
        report.check_folder(tmp_path, overwrite=True)
    assert (tmp_path / "thesis.txt").read_text() == "years of work"


def test_a_file_in_the_place_of_the_folder_is_refused(tmp_path):
    path = tmp_path / "taken"
    path.write_text("x")
    with pytest.raises(report.FolderError, match="is a file, not a folder"):
        report.check_folder(path, overwrite=True)


@pytest.mark.promise("report-1")
@pytest.mark.parametrize("error", [KeyboardInterrupt, OSError(28, "No space left on device"), MemoryError])
def test_an_interrupted_write_leaves_nothing_and_keeps_the_old(tmp_path, error):
    target = tmp_path / "out"
    with folder.whole_folder(target, overwrite=False) as draft:
        (draft / "manifest.json").write_text('{"mission": {}, "versions": {"microrad": "0"}}')
    with pytest.raises(BaseException) as caught, folder.whole_folder(target, overwrite=True) as draft:
        (draft / "half").write_text("written")
        raise error
    assert not isinstance(caught.value, report.FolderError)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["out"]
    assert sorted(p.name for p in target.iterdir()) == ["manifest.json"]


@pytest.fixture
def no_bench(monkeypatch):
    """The paper's experiment is the same in every mission's report."""
    monkeypatch.setattr(bench, "bench_figures", lambda *args: ())


@pytest.mark.usefixtures("no_numbers")
def test_text_of_the_mission_is_escaped(paper, tmp_path, monkeypatch):
    drawn = plain_drawn()
    monkeypatch.setattr(report, "study_figures", lambda *args: drawn)
    file = edited_file(
        tmp_path, ('name = "LEO-to-GEO relay of a 100 kg satellite"', 'name = "<script>alert(1)</script>"')
    )
    text = report.write(replace(paper, file=file), tmp_path / "out").read_text(encoding="utf-8")
    assert "<script>alert" not in text
    assert "&lt;script&gt;alert(1)&lt;/script&gt;" in text
    manifest = text.partition('<script type="application/json" id="manifest">')[2].partition("</script>")[0]
    assert json.loads(manifest)["mission"]["text"] == file.text


@pytest.mark.usefixtures("no_scan", "no_bench", "no_numbers")
def test_a_hopeless_link_is_reported_not_refused(tmp_path):
    file = edited_file(tmp_path, ('data_rate = "300 Mbit/s"', 'data_rate = "30 Gbit/s"'), day=False)
    hopeless = study.run_study(file)
    assert not hopeless.closes
    assert hopeless.communication.margin_db == pytest.approx(3.0 - 20.0, abs=0.02)
    assert math.isnan(hopeless.margin_map.largest_error_rad)
    assert "does not close" in report.verdict_text(hopeless)
    assert "not even on axis" in report.write(hopeless, tmp_path / "out").read_text(encoding="utf-8")


@pytest.mark.promise("decisions-1", "report-6")
def test_verdict_and_summary_say_the_same(paper):
    text, data = report.verdict_text(paper), report.summary(paper)
    assert data["closes"] is True
    assert data["met"] is False
    assert data["verdict"] in " ".join(text.split())
    marks = ["derived", "PASS", "PASS", "FAIL", "FAIL"]
    table = text.split("\n\n")[1]
    assert [word for word in table.split() if word in {"PASS", "FAIL", "derived"}] == marks
    assert [r["mark"] for r in data["requirements"]] == marks
    assert data["requirements"][0]["derived"][0].startswith("pointing.lines.misalignment.error = 248 urad (what ")
    assert [r["met"] for r in data["requirements"]] == [True, True, True, False, False]
    assert min(data["implied_sensitivity_photon_bit"]) == pytest.approx(76, abs=0.5)
    assert max(data["implied_sensitivity_photon_bit"]) == pytest.approx(291, abs=0.5)
    json.dumps(data)


def test_a_drive_beyond_the_identified_rate_is_the_first_thing_said(no_scan, paper, tmp_path):
    slow = study.run_study(edited_file(tmp_path, ('rate_limit = "3770 V/s"', 'rate_limit = "100 V/s"'), day=False))
    text = report.verdict_text(slow)
    assert "The mirror model is extrapolated." in " ".join(text.partition("\n\n")[0].split())
    assert "Not to be relied on" in text
    assert any("(identified up to 100 V/s)" in w for w in report.summary(slow)["warnings"])
    assert "Not to be relied on" not in report.verdict_text(paper)


@pytest.mark.promise("report-6")
def test_warnings_of_a_requirement_that_is_missed_stand_first(paper, monkeypatch):
    """Those of the others follow by what is to spare, and what puts the verdict in doubt is before both."""
    by = {r.subject: r for r in paper.requirements}
    beacon, answer = (replace(by[name], derived=()) for name in ("beacon", "answer"))
    met = [replace(each, actual=spare, margin=spare) for each, spare in ((beacon, 3.0), (answer, 1.0))]

    def order(*requirements):
        found = words.ranked_warnings(replace(paper, requirements=requirements))
        return next(iter(found)), [w.split(" budget:")[0] for w in found["The verdict"] if " budget:" in w]

    alike = order(*met)
    assert alike == ("The day", ["Answer", "Beacon", "Communication"])
    missed = replace(beacon, actual=-1.0, margin=-1.0)
    assert order(missed, met[1])[1] == ["Beacon", "Answer", "Communication"]
    doubt = words.Warned("the verdict's pointing loss is large", "verdict")
    monkeypatch.setattr(words, "_of_verdict", lambda study: [doubt])
    assert words.warnings(replace(paper, requirements=(missed, met[1])))[0] == "the verdict's pointing loss is large"
    stroke = replace(missed, subject="stroke")
    own, others = ["fine pointing: tuned", "fine pointing: the stroke does not cover"], []
    monkeypatch.setattr(words.fine_pointing_words, "warnings", lambda *_: (own, others))
    found = words.ranked_warnings(replace(paper, requirements=(*met, stroke), fine_pointing=object()))
    assert [*found][:2] == ["The loop that is judged", "The verdict"]
    assert found["The loop that is judged"] == own[::-1]


@pytest.mark.promise("report-6")
def test_warnings_stand_in_the_groups_that_the_page_of_the_report_names(paper, monkeypatch):
    monkeypatch.setattr(words.fine_pointing_words, "warnings", lambda *_: (["own"], ["other"]))
    for name, said in (("_of_verdict", [words.Warned("doubt")]), ("_of_runs", ["a limit"]), ("_of_budget_loop", [])):
        monkeypatch.setattr(words, name, lambda study, said=said: said)
    monkeypatch.setattr(words, "placards", lambda sources: [SimpleNamespace(text="beyond")])
    found = words.ranked_warnings(replace(paper, fine_pointing=object()))
    assert all(found.values())
    page_of_report = (ROOT / "docs" / "report.md").read_text(encoding="utf-8")
    listed = re.search("what they put in doubt: (.*?): limits met", page_of_report)[1]
    assert sorted(each.lower() for each in found) == sorted(listed.split(", "))


@pytest.mark.promise("decisions-1", "report-6")
def test_the_mirror_stands_with_its_model_the_margins_and_each_run_with_its_counts(paper):
    (view,) = (each for each in page.study_views(paper, plain_drawn()) if each.title == "Mirror and loop")
    (model,) = (block.text for block in view.blocks if isinstance(block, Verbatim))
    assert model.splitlines() == [line for line in str(paper.summary).splitlines() if "  warning" not in line]
    margins, runs = (block for block in view.blocks if isinstance(block, Table))
    assert [row[0] for row in margins.rows][:2] == ["gain margin", "phase margin"]
    assert (runs.folded, len(runs.rows)) == (f"Each of {len(paper.runs)} runs, with its counts", len(paper.runs))
    for row, run in zip(runs.rows, paper.runs, strict=True):
        c = run.trace.counts
        assert row[:3] == [run.mirror, run.controller, f"{run.freq_hz:g} Hz"]
        assert row[3:5] == [f"{1e6 * run.trace.peak_rad:.2f} µrad", f"{1e6 * run.trace.rms_rad:.2f} µrad"]
        counts = c.clamped + c.inverse_clamped, c.saturated, c.slew_limited, c.alternating
        assert row[5:] == [str(count) for count in counts]


@pytest.mark.promise("report-6")
def test_warnings_stand_by_what_they_cost_in_decibels(paper):
    """The mission's range is exceeded by 4.8 %, 0.41 dB by its square; what the others cost is not known."""
    (costly,) = (w for w in words._of_day(paper) if w.text.startswith("communication.distance is 42000 km"))
    furthest = max(e.range_most_m for e in paper.day.encounters)
    assert costly.cost_db == pytest.approx(20.0 * math.log10(furthest / 42e6)) == pytest.approx(0.41, abs=0.005)
    assert costly.text.endswith("costs 0.41 dB more than budgeted")
    met = replace(paper, requirements=[replace(r, actual=1.0, required=0.0, margin=1.0) for r in paper.requirements])
    assert words.warnings(met)[0] == costly.text
    assert [*words.ranked_warnings(met)][:2] == ["The day", "The verdict"]
    near = replace(paper.day, encounters=tuple(replace(e, range_most_m=42e6) for e in paper.day.encounters))
    assert words.warnings(replace(met, day=near))[0] != costly.text


def test_a_negative_number_has_a_minus_sign_whoever_worded_it(paper):
    (said,) = (w for w in words.warnings(paper) if w.startswith("not physical at reversals"))
    assert "falls to \u22120.885 mrad/V against d1 = 0.089" in said
    assert minus("-3 dB, x-1, 1e-9, a-b, (-2)") == "\u22123 dB, x-1, 1e-9, a-b, (\u22122)"


@pytest.fixture
def no_scan(monkeypatch):
    """The scan has tests of its own and takes the longest."""
    monkeypatch.setattr(study.paper, "applies", lambda mission: False)


def test_the_headline_names_the_link_that_does_not_close(no_scan, tmp_path):
    file = edited_file(tmp_path, ('required_power = "10 pW"', 'required_power = "1 nW"'), day=False)
    text = report.verdict_text(study.run_study(file))
    said = " ".join(text.partition("\n\n")[0].split())
    assert said.startswith("The link does not close: beacon \u221213.70 dB, at 300 Mbit/s")
    assert "communication" not in said


@pytest.mark.promise("report-8")
def test_an_amplifier_at_its_limits_is_named_as_the_cause_and_claims_are_not_judged(no_scan, tmp_path):
    weak = study.run_study(edited_file(tmp_path, ('output_max = "180 V"', 'output_max = "100 V"'), day=False))
    assert "What limits it: the amplifier's limits (" in report.verdict_text(weak, 160, verbose=True)
    assert {c.agrees for c in weak.claims if c.where in ("Fig. 6", "Fig. 8")} == {"not judged"}
    assert any("beyond the amplifier's range" in w for w in report.summary(weak)["warnings"])


@pytest.mark.promise("report-6")
@pytest.mark.usefixtures("no_scan")
def test_a_changed_value_does_not_keep_the_papers_name(paper, tmp_path):
    assert missionfile.changed_from_shipped(paper.file.sources) == ()
    file = edited_file(tmp_path, ('leo_aperture = "5 cm"', 'leo_aperture = "6 cm"'), day=False)
    assert missionfile.changed_from_shipped(file.sources) == (("terminals.leo_aperture", '"6 cm"', '"5 cm"'),)
    changed = study.run_study(file)
    assert any("names the paper as its source" in w for w in report.summary(changed)["warnings"])
    said = 'This mission is not the paper\'s: terminals.leo_aperture is "6 cm", there "5 cm".'
    assert said in paper_views.claims_view(changed).blocks
    assert not any("This mission is not" in str(block) for block in paper_views.claims_view(paper).blocks)
    for study_of, keys in ((paper, []), (changed, ["terminals.leo_aperture"])):
        (table,) = inputs_view(study_of.file.sources).blocks
        assert [table.rows[k][0].text for k in table.filters["changed from what is shipped"]] == keys
        assert f"{len(keys)} changed from what is shipped" in table.folded
    for comment in (" # my own", ""):  # a comment of one's own, or none, hides no change
        text = re.sub(
            'leo_aperture = "5 cm".*', f'leo_aperture = "67 mm"{comment}', SHIPPED.read_text(encoding="utf-8")
        )
        (tmp_path / "own.toml").write_text(text, encoding="utf-8")
        (table,) = inputs_view(missionfile.load_mission(tmp_path / "own.toml").sources).blocks
        rows = table.filters["changed from what is shipped"]
        assert [table.rows[k][0].text for k in rows] == ["terminals.leo_aperture"]


def test_a_radial_residual_is_two_axes(no_scan, paper, tmp_path):
    radial = study.run_study(edited_file(tmp_path, ('residual = "per-axis"', 'residual = "radial"'), day=False))
    used, one_axis = report.summary(radial)["residual"]["used_rad"], report.summary(paper)["residual"]["used_rad"]
    assert used == pytest.approx(math.sqrt(2.0) * one_axis, rel=1e-12)
    assert "times √2 for two equal axes" in report.verdict_text(radial, verbose=True)
    assert radial.achieved.margin_db < paper.achieved.margin_db - 2.0


def test_a_drive_beyond_the_identified_range_is_said(no_scan, tmp_path):
    narrow = study.run_study(edited_file(tmp_path, ('drive_max = "12 V"', 'drive_max = "8 V"'), day=False))
    text = report.verdict_text(narrow)
    assert "The mirror model is extrapolated." in " ".join(text.partition("\n\n")[0].split())
    assert "(identified from 0 to 8 V)" in text
    assert any("beyond the range that the mirror was identified for" in w for w in report.summary(narrow)["warnings"])


def test_a_cost_without_a_data_rate_is_said_in_decibels_alone():
    cost = Cost("sine of 25 Hz", "PID", "given", -1.5, math.nan)
    assert words._rate_lost(cost) == ""
    assert words._rate_lost(replace(cost, data_rate_bit_s=-252.4e6)) == " or 252 Mbit/s"
    assert words._rate_lost(replace(cost, data_rate_bit_s=-0.3e6)) == " or 300 kbit/s"


@pytest.mark.parametrize(("finding", "reading"), [(False, False), (True, False), (False, True), (True, True)])
def test_how_the_partner_is_found_is_said_where_both_the_ways_and_the_reading_are_known(finding, reading):
    outcome = SimpleNamespace(success_probability=0.98765, mean_time_s=12.0)
    ways = [
        SimpleNamespace(name="stare", outcome=outcome, possible=True),
        SimpleNamespace(name="spiral", outcome=None, possible=False),
    ]
    of = SimpleNamespace(
        links=SimpleNamespace(finding=SimpleNamespace(ways=ways) if finding else None),
        open_loop=SimpleNamespace(reading=SimpleNamespace(coverage=0.75) if reading else None),
    )
    said = words.found(of)
    assert bool(said) == (finding and reading)
    if said:
        assert "the stare locks with a probability of 0.9877, in 12 s on average; the spiral never locks." in said
        assert "with a probability of 0.75, biases" in said


@pytest.mark.parametrize(
    ("simulated_db", "budgeted_db", "fine"),
    [(20.1, 1.0, True), (1.0, 20.1, False), (20.0, 99.0, True), (99.0, 20.0, False)],
)
@pytest.mark.parametrize(("jitter", "under_db", "said_db"), [(False, 2.0, None), (True, 2.0, 1.0), (True, 5.0, 0.0)])
def test_what_the_verdict_leaves_out_is_said_with_what_it_may_cost(
    simulated_db, budgeted_db, fine, jitter, under_db, said_db
):
    """A jitter beside a simulated residual, and a pointing loss beyond the main lobe, of whichever case is judged."""
    of = plain_study()
    mission = of.file.mission.model_copy(update={"jitter": object() if jitter else None})
    made = SimpleNamespace(
        file=SimpleNamespace(mission=mission),
        fine_case=SimpleNamespace(outage_loss_db=simulated_db) if fine else None,
        achieved=SimpleNamespace(loss_db=lambda *lines: budgeted_db),
        communication=SimpleNamespace(margin_db=under_db),
        margin_db=3.0,
    )
    found = words._of_verdict(made)
    deep = (simulated_db if fine else budgeted_db) > 20.0
    assert [each.about for each in found] == ["verdict"] * (jitter + deep)
    if jitter:
        assert found[0].text.startswith("[jitter] is not in this verdict")
        assert found[0].cost_db == said_db
    if deep:
        assert "the verdict's pointing loss of 20.10 dB is beyond 20 dB" in found[-1].text and found[-1].cost_db == 20.1


def test_a_list_of_errors_is_in_the_summary_where_the_study_has_one(monkeypatch):
    of = plain_study()
    assert "error_budget" not in report.summary(replace(of, error_budget=None))
    monkeypatch.setattr(study_data, "budget_data", lambda budget: {"of": budget})
    assert report.summary(replace(of, error_budget="a list"))["error_budget"] == {"of": "a list"}


@pytest.mark.parametrize(("rate_bit_s", "words"), [(622.08e6, "622.08"), (0.4e6, "0.4"), (300e6, "300")])
def test_the_data_rate_of_this_mission_keeps_its_digits_below_the_papers(rate_bit_s, words):
    mission = SimpleNamespace(name="ours", communication=SimpleNamespace(data_rate_bit_s=rate_bit_s))
    table = paper_views.projects_table(SimpleNamespace(file=SimpleNamespace(mission=mission)))
    assert table.rows[-1] == ("", "this mission: ours", "", words, "")


# --------------------------------------------------------------------------------------- the chain and its contributors
def ns(**values):
    return SimpleNamespace(**values)


def a_swing(key, unit, swing_db):
    return ns(key=key, unit=unit, swing_db=swing_db)


def chain_study(**changes):
    """What the chain shows of a study without a fine loop, each number unlike the others."""
    m = ns(
        communication=ns(data_rate_bit_s=622.08e6, transmit_power_w=2.5, pointing_error_rad=7.5e-6),
        range_m=lambda link: 4.25e7,
        point_ahead=None,
        jitter=ns(rms_rad=(1e-6, 1e-6)),
        requirement=ns(pointing_error_rad=9e-6, residual_statistic="peak", margin_db=3.5),
        amplifier=ns(output_max_v=110.0, output_min_v=-10.0, gain=10.0),
        control=ns(rate_hz=12500.0),
    )
    day = ns(
        encounters=[ns(range_most_m=3e7), ns(range_most_m=4.5e7)],
        relay=ns(contacts=range(7), contact_s=9000.0, capacity_bit=8e12, arrived_bit=4e12),
        direct=ns(capacity_bit=1.6e12),
        optical=ns(capacity_bit=2.4e12),
        view=ns(days=1.5, partner="station"),
    )
    given = {
        "file": ns(mission=m, sources={}),
        "links": ns(data=ns(beam=ns(fall=ns(half_angle_rad=2.1e-5)))),
        "static": ns(margin_db=4.25),
        "open_loop": ns(rss_rad=3.1e-4, beacon_half_angle_rad=4.5e-4, reading=ns(coverage=0.875)),
        "fine_pointing": None,
        "fine_case": None,
        "requirements": [ns(subject="cone", mark="PASS", met=True), ns(subject="residual", mark="FAIL", met=False)],
        "loops": [ns(freq_hz=80.0, width=0.15), ns(freq_hz=0.5, width=0.025), ns(freq_hz=10.0, width=0.05)],
        "summary": ns(model=None),
        "residual": ns(controller="PID", freq_hz=25.0),
        "margins": ns(modulus=0.4375),
        "left_rad": lambda run: 1.21e-5,
        "day": day,
        "margin_map": ns(largest_rate_bit_s=1.2e9),
        "margin_db": -1.125,
        "met": False,
    }
    return ns(**given | changes)


def test_the_chain_of_a_station_with_optical_downlinks_has_each_number_in_its_box(monkeypatch):
    monkeypatch.setattr(chain, "output_amplitude", lambda model, half_v: 1e-4 * half_v)
    monkeypatch.setattr(chain, "with_sign", lambda text, sources, name: f"{text} <{name}>")
    assert [[box.name, list(box.lines), box.mark] for box in chain.stages(chain_study())] == [
        ["Orbit", ["7 contacts in 36 h", "150 min in view of the station", "42500 km, up to 45000 km"], ""],
        [
            "Link",
            [
                "622.1 Mbit/s with 2.5 W",
                "beam 21 µrad (half, 1/e²)",
                "static margin +4.25 dB <margin_db.communication_static> as budgeted,",
                "at 7.5 µrad off axis",
            ],
            "",
        ],
        [
            "Pointing",
            ["open loop 310 µrad (rss)", "beacon's cone 450 µrad, covers 87.5 %", "fine: 9 µrad allowed"],
            "PASS",
        ],
        ["Mirror", ["reach 1.2 mrad over 12 V", "hysteresis 2.5 % at 0.5 Hz,", "15.0 % at 80 Hz"], ""],
        ["Loop", ["PID at 12.5 kHz", "modulus margin 0.44"], ""],
        ["Residual", ["12.1 µrad peak, 25 Hz sine", "allowed 9 µrad"], "FAIL"],
        [
            "Volume",
            [
                "1 TB <day.relay.could_carry_bit> possible by the station",
                "500 GB <day.relay.arrived_bit> of the instrument's",
                "200 GB <day.direct.could_carry_bit> direct to ground",
                "300 GB <day.optical.could_carry_bit> by optical stations",
            ],
            "",
        ],
        [
            "Verdict",
            ["1 of 2 requirements met", "link at the residual −1.12 dB <margin_db.judged>,", "3.5 dB required"],
            "FAIL",
        ],
    ]
    bare = chain_study(day=None, loops=[])
    assert [list(box.lines) for box in chain.stages(bare) if box.name in ("Orbit", "Mirror", "Volume")] == [
        ["42500 km as budgeted"],
        ["reach 1.2 mrad over 12 V"],
        ["up to 1.2 Gbit/s", "no orbits given: no volume a day"],
    ]
    nothing = chain_study(day=None, margin_map=ns(largest_rate_bit_s=math.nan))
    assert chain._volume(nothing).lines[0] == "no rate has the required margin"


def test_the_residual_of_the_chain_passes_where_it_and_the_budget_do():
    kept = [ns(subject="residual", met=True), ns(subject="error budget", met=True), ns(subject="cone", met=False)]
    box = chain._residual(chain_study(requirements=kept))
    assert (box.mark, box.lines[-1]) == ("PASS", "error budget: 1 of 1 kept")
    missed = [*kept, ns(subject="error budget", met=False)]
    box = chain._residual(chain_study(requirements=missed))
    assert (box.mark, box.lines[-1]) == ("FAIL", "error budget: 1 of 2 kept")


@pytest.mark.parametrize(
    ("swings", "said"),
    [
        ([("a.b", "W", 2.5)], "; the margin moves most with a.b: 2.50 dB for ±10 %"),
        ([("a.b", "dB", math.inf), ("c.d", "dBm", 1.25)], "; the margin moves most with c.d: 1.25 dB for ±0.5 dB"),
        (
            [("code.bit_error_ratio", "", 0.5)],
            "; the margin moves most with code.bit_error_ratio: 0.50 dB for ten times",
        ),
        ([("a.b", "W", math.nan)], ""),
        ([], ""),
    ],
)
def test_what_moves_a_margin_most_is_told_by_how_it_is_moved(swings, said):
    found = requirement_views.most_sensitive([a_swing(*each) for each in swings])
    assert found.startswith(said) and bool(found) is bool(said)


def test_the_largest_loss_is_one_that_a_design_can_change():
    lines = [
        ns(name="Free space loss", unit="dB", value=-290.0),
        ns(name="Transmitted power", unit="dBm", value=-300.0),
        ns(name="Receiver optics", unit="dB", value=-2.5),
        ns(name="Pointing loss", unit="dB", value=-6.25),
    ]
    lines[0].name = requirement_views.FREE_SPACE_LOSS
    assert requirement_views.largest_loss(ns(lines=lines)) == "Pointing loss 6.25 dB"


def stroke_study(*, margin_rad, values=(3e-4, 7e-5), ratio=0.5):
    lines = [ns(name=name, value=value) for name, value in zip(("Body pointing", "Point-ahead"), values, strict=True)]
    axis = ns(lines=lines, margin_rad=margin_rad, mirror_per_line_of_sight=ratio, name="x")
    other = ns(lines=lines[::-1], margin_rad=margin_rad + 1e-3, mirror_per_line_of_sight=1.0, name="y")
    table = ns(body=ns(error_rad=1.5e-4), reference=ns(point_ahead_rad=8e-5))
    scene = ns(own_stroke=(other, axis))
    return ns(file=ns(mission=ns(fine_pointing=table)), fine_pointing=ns(scene=scene))


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"margin_rad": -5e-5}, "; to meet it, take fine_pointing.body.error = 100 µrad or less"),
        ({"margin_rad": -2e-4}, "; to meet it, raise mirror.travel"),
        (
            {"margin_rad": -1e-5, "values": (1e-5, 1e-4)},
            "; to meet it, take fine_pointing.reference.point_ahead = 64 µrad or less",
        ),
    ],
)
def test_a_stroke_is_advised_by_its_largest_line_on_the_axis_that_has_least(changes, said):
    missed = Requirement("stroke", "stroke", "rad", 5e-4, 6e-4, -1e-4, "")
    assert requirement_views.advice(stroke_study(**changes), missed) == said


@pytest.mark.parametrize(
    ("subject", "limited_by", "said"),
    [
        ("residual", "the amplifier's slew limit", "raise amplifier.slew"),
        ("residual", "the amplifier's output limits", "raise amplifier.output_max"),
        ("residual", "lag", "raise control.integral"),
        ("fine pointing", "OLYMPUS", "raise fine_pointing.rate"),
        ("fine pointing", requirement_views.OPTICAL_NOISE, "change fine_pointing.optical_sensor"),
        ("fine pointing", requirement_views.GAUGE_NOISE, "change fine_pointing.strain_gauge"),
    ],
)
def test_what_is_advised_follows_from_what_limits_it(subject, limited_by, said):
    missed = Requirement(subject, "r", "rad", 1e-5, 2e-5, -1e-5, limited_by)
    assert requirement_views.advice(stroke_study(margin_rad=1.0), missed) == f"; to meet it, {said}"
    assert requirement_views.advice(stroke_study(margin_rad=1.0), replace(missed, unknown="a noise")) == ""


@pytest.mark.parametrize(
    ("kind", "stated", "allowed", "said"),
    [
        ("random", {"size_rad": 4e-6}, 0.5, "; to meet it, take error_budget.sources.a"),
        ("drift", {"size_rad": 9e-6, "rate_rad_s": 4e-9}, 0.25, "; to meet it, take error_budget.sources.a"),
        ("random", {"size_rad": 4e-6}, 0.0, "; to meet it, change error_budget.sources.a"),
        ("random", {"size_rad": 4e-6}, math.inf, "; to meet it, change error_budget.sources.a"),
    ],
)
def test_a_source_of_errors_is_advised_so_many_times_its_size(kind, stated, allowed, said):
    missed = Requirement("error budget", "total", "rad", 1e-5, 2e-5, -1e-5, "a")
    share = ns(name="a", allowed=allowed, contribution=ns(kind=kind))
    other = ns(name="b", allowed=3.0, contribution=ns(kind="loop"))
    first = Requirement("error budget", "first", "rad", 1e-5, 5e-6, 5e-6, "b")
    of = ns(
        requirements=[first, ns(subject="cone"), missed],
        error_budget=ns(judged=[ns(shares=[other]), ns(shares=[share])]),
        file=ns(mission=ns(error_budget=ns(sources={"a": ns(kind=kind, **stated)}))),
    )
    found = requirement_views.advice(of, missed)
    assert found.startswith(said)
    if allowed == 0.5:
        assert found.endswith("= 2 µrad or less")
    if allowed == 0.25:
        assert found.endswith("= 1 nrad/s or less")
    assert requirement_views.advice(of, first) == "; to move it, raise fine_pointing.rate"


# ------------------------------------------------------------------------------- drawings, readings and words by hand
def test_the_drawings_of_a_mission_of_unlike_numbers(monkeypatch):
    lines = [ns(name=name, value=value) for name, value in (("Body", 2.5e-4), ("Orbit", 1.1e-5), ("Mount", 7e-5))]
    lines += [ns(name="Fourth", value=1e-6), ns(name="Fifth", value=2e-6)]
    m = ns(
        beacon=ns(divergence_rad=8.4e-4),
        answer=ns(divergence_rad=4.6e-5),
        point_ahead=None,
        communication=ns(data_rate_bit_s=622.08e6),
        range_m=lambda of: 4.12e7,
        control=ns(
            proportional_v_rad=1250.0, integral_v_rad_s=1.6e7, derivative_v_s_rad=0.5,
            rate_hz=12500.0, delay_s=3.2e-5, sensor_resolution_rad=2.71e-8,
        ),
        amplifier=ns(bandwidth_hz=4200.0),
        mirror=ns(linear=None, bouc_wen=None),
    )  # fmt: skip
    study = ns(file=ns(mission=m), open_loop=ns(lines=lines, rss_rad=3.1e-4, beacon_half_angle_rad=6.2e-4))
    relay = drawings.relay(study)
    assert (relay["height"], relay["range"]) == (420.0, "41200 km")
    assert [(row["text"], round(row["width"], 3), row["colour"]) for row in relay["errors"]] == [
        ("Body 250 µrad", 80.645, "#E69F00"),
        ("Orbit 11 µrad", 3.548, "#56B4E9"),
        ("Mount 70 µrad", 22.581, "#009E73"),
        ("Fourth 1 µrad", 0.323, "#CC79A7"),
        ("Fifth 2 µrad", 0.645, "#E69F00"),
        ("root sum square 310 µrad", 100.0, "#1b1f24"),
        ("cone of the beacon 620 µrad", 200.0, "#0072B2"),
    ]
    steps = ["wide beacon, 840 µrad", "answer, 46 µrad", "narrow beam back", "lock; 622.1 Mbit/s"]
    assert relay["sequence"] == steps and f"Sequence: {'; '.join(steps)}. Open-loop" in relay["words"]
    assert relay["words"].endswith("Fifth 2 µrad, root sum square 310 µrad, cone of the beacon 620 µrad.")
    control = drawings.control(study)
    gains = ("Kp 1.25 V/mrad", "Ki 16000 V/(mrad s)", "Kd 0.0005 V s/mrad")
    assert control["pid"] == ("PID", *gains, "12.5 kHz, 32 µs late")
    assert control["plant"] == ("Mirror", "amplifier, 4.2 kHz", "hysteresis")
    assert control["sensor"] == ("Strain gauge", "0.0271 µrad steps")
    assert f"PID ({', '.join(gains)}, at 12.5 kHz, 32 µs late) on the" in control["words"]
    assert "mirror (amplifier, 4.2 kHz, hysteresis), whose" in control["words"]


def test_other_readings_stand_below_the_missions_own_with_what_they_turn(monkeypatch):
    monkeypatch.setattr(requirement_views, "unknown", lambda mirror: "")
    of = requirement_views.Reading
    study = ns(
        file=ns(mission=ns(requirement=ns(pointing_error_rad=9e-6, margin_db=3.5), mirror=None)),
        left_rad=lambda run: 8.9e-6,
        residual=None,
        achieved=ns(margin_db=3.5),
        other_readings=[
            of("a.b", "one", "other", 9.1e-6, 4.25),
            of("c.d", "two", "third", 5e-6, -0.004),
            of("e.f", "x", "y", math.nan, math.nan, "it does not run"),
        ],
    )
    table = requirement_views.readings_table(study)
    assert [[str(cell) for cell in row] for row in table.rows] == [
        ["as it stands", "", "", "8.9 µrad", "3.50 dB", "yes", "PASS"],
        ["a.b", "one", "other", "9.1 µrad", "4.25 dB", "yes", "FAIL"],
        ["c.d", "two", "third", "5 µrad", "−0.004 dB", "no", "FAIL"],
        ["e.f", "x", "y", "it does not run", "", "", ""],
    ]
    assert [row[0].code for row in table.rows] == [False, True, True, True]
    assert words.read_otherwise(study) == [
        "With one point of the paper read otherwise that link would not close: c.d = third (−0.004 dB)."
    ]
    study.other_readings, study.achieved.margin_db = study.other_readings[:1], -1.0
    assert words.read_otherwise(study) == [
        "With one point of the paper read otherwise that link would close: a.b = other (4.25 dB)."
    ]
    study.other_readings = [of("e.f", "x", "y", math.nan, math.nan, "it does not run")]
    assert words.read_otherwise(study) == []


def test_hysteresis_costs_what_it_costs_however_little():
    costs = [Cost("sine of 25 Hz", "PID", "given", -0.0034, -0.3e6)]
    study = ns(
        residual=ns(freq_hz=25.0, controller="PID"), fine_pointing=None, performance=ns(costs=costs, outage=0.003)
    )
    assert words.hysteresis_cost(study).startswith(
        "Hysteresis costs the link 0.003 dB or 300 kbit/s with PID (sine of 25 Hz), at"
    )


@pytest.mark.parametrize(
    ("fastest", "span", "told"),
    [
        (3772.0, (-6.0, 6.0), "3.772 kV/s (identified up to 3.77 kV/s)"),
        (150.0, (-6.0, 6.004), "0 to 12.004 V (identified from 0 to 12 V)"),
        (150.0, (-7.5, 3.0), "−1.5 to 9 V (identified from 0 to 12 V)"),
        (3770.0, (-6.0, 6.0), ""),
    ],
)
def test_a_drive_is_told_apart_from_what_the_mirror_was_identified_for(fastest, span, told):
    mirror = ns(rate_limit_v_s=3770.0, bias_v=6.0, drive_min_v=0.0, drive_max_v=12.0)
    run = ns(fastest_drive_v_s=fastest, drive_span_v=span, mirror=None, trace=ns(name="a run"))
    said = words.beyond_identified(ns(file=ns(mission=ns(mirror=mirror))), run)
    assert said == (f"a run: the mirror model is extrapolated to a drive of {told}" if told else "")


@pytest.mark.parametrize(("count", "s"), [(1, ""), (2, "s")])
def test_what_is_counted_has_its_number(monkeypatch, count, s):
    monkeypatch.setattr(words, "beyond_identified", lambda study, run: "")
    counts = ns(clamped=count, inverse_clamped=0, saturated=count, slew_limited=count, alternating=count)
    assert words._of_runs(ns(runs=[ns(trace=ns(name="a", counts=counts))])) == [
        f"a: {count} step{s} beyond the identified rate",
        f"a: {count} saturated sample{s}",
        f"a: {count} slew-limited step{s}",
        f"a: {count} reversal{s} of the command within 10 samples of the last",
    ]
    m = ns(
        mirror=ns(bias_v=6.0, drive_min_v=0.0, drive_max_v=12.0),
        scenario=ns(loop_amplitude_v=1.0),
        amplifier=ns(output_min_v=0.0, gain=10.0, output_max_v=120.0),
    )
    said = words._of_loops(ns(file=ns(mission=m), loops=[ns(freq_hz=5.0, clamped=count)]))
    assert said == [f"hysteresis loop at 5 Hz: {count} sample{s} beyond the identified rate"]
    monkeypatch.setattr(chain, "_with_stroke", lambda study, lines: lines)
    mirror = ns(name="m", actuators=count, axes=3 - count, A=np.eye(4))
    of = chain_study(fine_pointing=ns(scene=ns(loop=ns(mirror=mirror))))
    of.day.relay.contacts = range(count)
    assert chain._orbit(of).lines[0] == f"{count} contact{s} in 36 h"
    assert chain._mirror(of)[1] == ("2 actuators, 1 output" if s else "1 actuator, 2 outputs")


# -------------------------------------------------------------------------------- the paper's parts of made-up numbers
def test_the_chirp_of_the_bench_is_drawn_whole_and_close_up_with_its_response():
    time = np.arange(5.0) / 4.0
    close = slice(3, 1503)
    found = bench.Chirp(
        time, 2.0 * time, 1e-6 * time, 1.5e-6 * time, 96.54, np.array([2.0, 50.0, 333.3]),
        1e-6 * np.array([4.0, -3.0j, -2.0]),
        1e-6 * np.array([5.0, 3.5j, 1.0]),
    )  # fmt: skip
    assert bench.close_up(found) == close
    lines = figure_of(bench.chirp_figure(found))
    assert lines[:2] == ["fig4-chirp", "Fig. 4  Identified linear dynamics (virtual bench)"]
    assert "a chirp of 2 Hz to 333.3 Hz played into Eq. 2" in lines[2] and "5 poles" in lines[2]
    assert "explains 96.5 % of it (the paper: about 97 %)" in lines[2]
    assert lines[3] == {
        "time, close up (s)": [0.75, 1.0],
        "drive about its mean (V)": [1.5, 2.0],
        "measured about its mean (rad)": [7.5e-7, 1e-6],
        "modelled about its mean (rad)": [1.125e-6, 1.5e-6],
        "frequency (Hz)": [2.0, 50.0, 333.3],
        "gain, measured (rad/V)": [4e-6, 3e-6, 2e-6],
        "phase, measured (rad)": [0.0, -1.5708, -3.14159],
        "gain, model (rad/V)": [5e-6, 3.5e-6, 1e-6],
        "phase, model (rad)": [0.0, 1.5708, 0.0],
    }
    assert "\n".join(lines[4:]) == one_text("""
Sheet width=7.6 height=5.4 heights=[1 1] widths=[1 1] legend=<place=above columns=2>
Panel 0 0 x=<title=time (s)> y=<title=output about its mean (µrad)>
Line x=[0 0.25 0.5 0.75 1] y=[0 0.25 0.5 0.75 1] colour=#D55E00 width=1.1 label=measured
  (virtual bench)
Line x=[0 0.25 0.5 0.75 1] y=[0 0.375 0.75 1.125 1.5] colour=#0072B2 dash=-- width=1.1
  label=model
Panel 0 1 x=<title=time (s)> y=<title=output about its mean (µrad)>
Line x=[0.75 1] y=[0.75 1] colour=#D55E00 width=1.1 label=measured (virtual bench)
Line x=[0.75 1] y=[1.125 1.5] colour=#0072B2 dash=-- width=1.1 label=model
Panel 1 0 x=<title=frequency (Hz) log=True high=333.3> y=<title=gain (µrad/V) low=0>
Line x=[2 50 333.3] y=[4 3 2] colour=#D55E00 dash= marker=. size=3
Line x=[2 50 333.3] y=[5 3.5 1] colour=#0072B2 dash=-- size=3
Panel 1 1 x=<title=frequency (Hz) log=True high=333.3> y=<title=phase (°)>
Line x=[2 50 333.3] y=[0 -90 -180] colour=#D55E00 dash= marker=. size=3
Line x=[2 50 333.3] y=[0 90 0] colour=#0072B2 dash=-- size=3
""")


def test_loops_of_the_bench_say_which_was_fitted_and_which_are_predicted():
    drive = np.array([0.0, 1.0, 2.0])
    loops = tuple(
        bench.Loop(f, 60.0, drive + f, 1e-3 * drive * f, 1.1e-3 * drive * f, 0.125 * f) for f in (1.0, 25.0, 60.0)
    )
    lines = figure_of(bench.loops_figure(loops))
    assert "Eq. 3 is fitted to the 60 Hz record alone and predicts the others" in lines[2]
    assert list(lines[3]) == [f"{what} at {f} Hz ({unit})" for f in (1, 25, 60) for what, unit in LOOP_COLUMNS]
    assert "\n".join(lines[4:]) == one_text("""
Sheet width=7.6 height=3.2 widths=[1 1 1] share_y=True
Panel 0 0 x=<title=drive (V) most=4> y=<title=output (mrad)> title=1 Hz, predicted: 0.12 % rms
  title_size=8.5 legend=<place=upper left>
Line x=[1 2 3] y=[0 1 2] colour=#0072B2 dash= label=measured (virtual bench) marker=o size=4.5
  face=
Line x=[1 2 3] y=[0 1.1 2.2] width=0.9 label=model
Panel 0 1 x=<title=drive (V) most=4> title=25 Hz, predicted: 3.12 % rms title_size=8.5
Line x=[25 26 27] y=[0 25 50] colour=#009E73 dash= label=measured (virtual bench) marker=o
  size=4.5 face=
Line x=[25 26 27] y=[0 27.5 55] width=0.9 label=model
Panel 0 2 x=<title=drive (V) most=4> title=60 Hz, fitted: 7.50 % rms title_size=8.5
Line x=[60 61 62] y=[0 60 120] colour=#D55E00 dash= label=measured (virtual bench) marker=o
  size=4.5 face=
Line x=[60 61 62] y=[0 66 132] width=0.9 label=model
""")
    x, y = bench._points(np.arange(125.0), 1e-3 * np.arange(125.0))
    assert (list(x), list(y)) == (list(range(0, 125, 2)), pytest.approx(list(range(0, 125, 2))))


LOOP_COLUMNS = (("drive", "V"), ("measured", "rad"), ("model", "rad"))


@pytest.mark.parametrize(
    ("changes", "pid", "plant"),
    [
        (
            {},
            ["Kp 2 V/mrad", "Ki 300 V/(mrad s)", "Kd 0.04 V s/mrad"],
            ["amplifier, 2 kHz", "hysteresis, Eq. 3", "linear part, Eq. 2"],
        ),
        (
            {"derivative_v_s_rad": 0.0},
            ["Kp 2 V/mrad", "Ki 300 V/(mrad s)"],
            ["amplifier, 2 kHz", "hysteresis, Eq. 3", "linear part, Eq. 2"],
        ),
        (
            {"linear": None},
            ["Kp 2 V/mrad", "Ki 300 V/(mrad s)", "Kd 0.04 V s/mrad"],
            ["amplifier, 2 kHz", "hysteresis, Eq. 3"],
        ),
        (
            {"bouc_wen": None},
            ["Kp 2 V/mrad", "Ki 300 V/(mrad s)", "Kd 0.04 V s/mrad"],
            ["amplifier, 2 kHz", "hysteresis", "linear part, Eq. 2"],
        ),
    ],
)
def test_the_diagram_of_the_control_has_the_gains_and_parts_that_there_are(changes, pid, plant):
    c = {
        "proportional_v_rad": 2e3,
        "integral_v_rad_s": 3e5,
        "derivative_v_s_rad": 40.0,
        "rate_hz": 2e4,
        "delay_s": 5e-5,
    }
    mirror = {"linear": 1, "bouc_wen": 2} | {k: v for k, v in changes.items() if k in ("linear", "bouc_wen")}
    control = ns(**c | {k: v for k, v in changes.items() if k in c}, sensor_resolution_rad=1.25e-7)
    mission = ns(control=control, mirror=ns(**mirror), amplifier=ns(bandwidth_hz=2e3))
    found = drawings.control(ns(file=ns(mission=mission)))
    assert found["pid"] == ("PID", *pid, "20 kHz, 50 µs late")
    assert found["plant"] == ("Mirror", *plant)
    assert found["sensor"] == ("Strain gauge", "0.125 µrad steps")
    assert (
        f"PID ({', '.join(pid)}, at 20 kHz, 50 µs late)" in found["words"]
        and f"({', '.join(plant)}), whose" in found["words"]
    )


@pytest.mark.parametrize("ahead", [None, 1])
def test_the_drawing_of_the_relay_has_a_bar_for_each_error_to_the_scale_of_the_largest(ahead):
    lines = [ns(name=f"e{k}", value=1e-5 * (k + 1)) for k in range(5)]
    mission = ns(
        range_m=lambda of: 4.2e7, communication=ns(data_rate_bit_s=622.08e6), beacon=ns(divergence_rad=7e-4),
        answer=ns(divergence_rad=2e-5), point_ahead=ahead,
    )  # fmt: skip
    found = drawings.relay(
        ns(file=ns(mission=mission), open_loop=ns(lines=lines, rss_rad=8e-5, beacon_half_angle_rad=1e-4))
    )
    assert [(each["text"], round(each["width"], 6), each["colour"]) for each in found["errors"]] == [
        ("e0 10 µrad", 20.0, "#E69F00"), ("e1 20 µrad", 40.0, "#56B4E9"), ("e2 30 µrad", 60.0, "#009E73"),
        ("e3 40 µrad", 80.0, "#CC79A7"), ("e4 50 µrad", 100.0, "#E69F00"),
        ("root sum square 80 µrad", 160.0, "#1b1f24"),
        ("cone of the beacon 100 µrad", 200.0, "#0072B2"),
    ]  # fmt: skip
    steps = [
        "wide beacon, 700 µrad",
        "answer, 20 µrad",
        f"narrow beam back{', point-ahead' * bool(ahead)}",
        "lock; 622.1 Mbit/s",
    ]
    assert (found["height"], found["range"], found["sequence"]) == (420.0, "42000 km", steps)
    assert f"Sequence: {'; '.join(steps)}. Open-loop pointing errors: e0 10 µrad, e1 20 µrad" in found["words"]


# ------------------------------------------------------------------------------------------- words of made-up numbers
@pytest.mark.parametrize(
    ("rate", "said"),
    [
        (math.nan, ""), (-51.4e6, " or 51 Mbit/s"), (-1e6, " or 1 Mbit/s"), (-999e3, " or 999 kbit/s"),
        (-1500.0, " or 1.5 kbit/s"), (-622.08e6, " or 622 Mbit/s"),
    ],
)  # fmt: skip
def test_a_rate_that_goes_with_a_cost_is_in_megabits_from_one_on(rate, said):
    assert words._rate_lost(ns(data_rate_bit_s=rate)) == said


@pytest.mark.parametrize(
    ("lines", "said"),
    [
        ([("a", -1.5, "dB"), ("b", -2.25, "dB"), ("c", -9.0, "dBW")], "b 2.25 dB"),
        ([(FREE_SPACE_LOSS, -290.0, "dB"), ("b", -2.25, "dB"), ("c", 7.0, "dB")], "b 2.25 dB"),
        ([("a", -2.0, "dB"), ("b", -2.0, "dB")], "a 2.00 dB"),
    ],
)
def test_the_largest_loss_that_a_design_can_change_is_in_decibels_and_not_that_of_space(lines, said):
    budget = ns(lines=[ns(name=name, value=value, unit=unit) for name, value, unit in lines])
    assert requirement_views.largest_loss(budget) == said


@pytest.mark.parametrize(
    ("swings", "said"),
    [
        ([], ""),
        ([a_swing("a.b", "W", math.inf)], ""),
        (
            [a_swing("a.b", "W", math.inf), a_swing("c.d", "m", 1.5), a_swing("e", "W", 9.0)],
            "; the margin moves most with c.d: 1.50 dB for ±10 %",
        ),
        ([a_swing("c.loss", "dB", 0.5)], "; the margin moves most with c.loss: 0.50 dB for ±0.5 dB"),
        ([a_swing("c.gain", "dBW", 0.5)], "; the margin moves most with c.gain: 0.50 dB for ±0.5 dB"),
        ([a_swing("r.outage", "", 0.25)], "; the margin moves most with r.outage: 0.25 dB for ten times more or less"),
        (
            [a_swing("a.bit_error_ratio", "", 0.25)],
            ("; the margin moves most with a.bit_error_ratio: 0.25 dB for ten times more or less"),
        ),
    ],
)
def test_the_input_that_moves_a_margin_most_is_the_first_with_a_number_in_its_own_step(swings, said):
    assert requirement_views.most_sensitive(swings) == said


@pytest.mark.parametrize(
    ("gain", "phase", "delay", "crossover", "shown"),
    [
        (2.0, 0.75, 1.25e-4, 123.4, ["6.0 dB", "43°", "125 µs", "0.312", "123 Hz"]),
        (math.inf, 1.5, 2e-3, math.nan, ["none needed", "86°", "2 ms", "0.312", "none"]),
        (1.5, 0.5, 1e-6, 98765.0, ["3.5 dB", "29°", "1 µs", "0.312", "98.8 kHz"]),
    ],
)
def test_the_margins_of_the_papers_loop_are_told_in_the_units_of_a_designer(gain, phase, delay, crossover, shown):
    of = ns(gain_up=gain, phase_rad=phase, delay_s=delay, modulus=0.31249, crossover_hz=crossover)
    found = page._margins(ns(margins=of))
    assert [text for _, text in found] == shown
    assert [name for name, _ in found] == [
        "gain margin",
        "phase margin",
        "delay margin",
        "modulus margin, min |1 + L|",
        "crossover",
    ]


def test_what_is_not_in_a_study_depends_on_its_loop_its_day_and_its_sky():
    def said(fine=None, day=None):
        return page._not_in_study(ns(fine_pointing=fine, day=day)).blocks[0]

    mode = "the pointing loss that a receiver into a single mode has on its own side."
    sines = " The residual is that of one axis tracking clean sines."
    times = "light time in the times of contacts, drag, weather over"
    assert said() == f"Vibration, sensor noise and turbulence; contact times; {mode}{sines}"
    assert said(fine=1) == f"Turbulence; contact times; {mode}"
    assert said(day=ns(sky=None)) == f"Vibration, sensor noise and turbulence; {times} the stations; {mode}{sines}"
    assert said(fine=1, day=ns(sky=1)) == f"Turbulence; {times} radio stations; {mode}"


def test_the_origin_of_a_report_has_each_file_with_its_digest_and_what_made_it(monkeypatch):
    monkeypatch.setattr(page, "versions", lambda: {"microrad": "1.2", "numpy": "3.4"})
    manifest = {
        "mission": {"file": "m.toml", "sha256": "aa"}, "mirror": {"file": "lab.toml", "sha256": "bb"},
        "inputs_sha256": {"x.csv": "cc", "y.csv": "dd"}, "machine": {"cpu": "one", "blas": "two"},
        "randomness": "seeds",
        "files_sha256": {"f.csv": 1, "f.svg": 2, "g.csv": 3},
    }  # fmt: skip
    assert outline(page._origin(manifest)) == one_text("""
# Manifest
This page holds what made it, as JSON: the mission's text, the files that it names, versions, seeds, the numbers of
  the summary and a hash of each figure's file. microrad reproduce report.html runs it again and says whether the
  numbers agree.
| -: what / value [0, 1]
mission file / m.toml, SHA-256 aa
mirror file / lab.toml, SHA-256 bb
named file / x.csv, SHA-256 cc
named file / y.csv, SHA-256 dd
random numbers / seeds
machine / cpu: one; blas: two
figures, as data and drawn / 3 files with their hashes
Made with microrad 1.2, numpy 3.4. Hashes of every file, this page's too, are in manifest.json.
""")
    assert len(page._origin({**manifest, "mirror": None, "inputs_sha256": {}}).blocks[1].rows) == 4


@pytest.mark.parametrize(
    ("data", "found"),
    [
        (math.nan, None), (-math.inf, None), (np.float64(1.5), 1.5), (np.float32(np.inf), None), (np.int64(3), 3),
        (np.bool_(True), True), ("nan", "nan"), (None, None), (0.0, 0.0), ((1.0, math.inf), [1.0, None]),
        ({"a": [np.nan, {"b": (2,)}], 3: "c"}, {"a": [None, {"b": [2]}], 3: "c"}),
    ],
)  # fmt: skip
def test_plain_data_have_python_numbers_and_none_for_what_is_not_finite(data, found):
    plain = finite(data)
    assert plain == found and type(plain) is type(found)


@pytest.mark.parametrize("inside", ["", scripts.MARK, "</body> <p>"])
def test_a_page_has_its_scripts_before_its_last_end_and_the_drawing_library_where_it_draws(inside):
    made = scripts.with_scripts(f"<body>{inside}</body></html>")
    library = scripts.library() if inside == scripts.MARK else ""
    assert made == f"<body>{inside}{scripts.keyboard()}{library}</body></html>"
    assert scripts.keyboard().count("<script>") == 1 and scripts.library().count("<script>") == 2


def test_the_bandwidth_of_the_fine_loop_stands_in_the_chain_without_a_power_of_ten():
    design = ns(name="LQG", loop_margins=ns(modulus=0.5, bandwidth_hz=1234.0))
    fine = ns(best=ns(design=design), scene=ns(loop=ns(timing=ns(period_s=1e-4))))
    lines = chain._loop(chain_study(fine_pointing=fine)).lines
    assert lines[-2:] == ("LQG at 10 kHz", "modulus 0.50, 1230 Hz wide")


# ------------------------------------------------------------------------------------ the words of a study, unlike each
def words_study(**changes):
    """What the verdict in words is made of, each number unlike the others; three requirements, two of them missed."""
    m = ns(
        communication=ns(data_rate_bit_s=625e6, pointing_error_rad=7.5e-6),
        requirement=ns(residual_statistic="rms", pointing_error_rad=9e-6, margin_db=3.5),
        conventions=ns(residual="radial"),
        jitter=None,
    )
    given = {
        "file": ns(mission=m, sources={}),
        "fine_case": None,
        "fine_pointing": None,
        "day": None,
        "residual": ns(controller="PID", freq_hz=25.0, trace=ns(peak_rad=2.5e-5, rms_rad=1.6e-5)),
        "left_rad": lambda run: 1.21e-5,
        "closes": True,
        "margin_db": 2.25,
        "beacon": ns(margin_db=1.5),
        "answer": ns(margin_db=0.0),
        "static": ns(margin_db=4.25),
        "achieved": ns(margin_db=-0.75),
        "requirements": (
            Requirement("residual", "residual", "rad", 9e-6, 1.2e-5, -3e-6, "the residual: lag"),
            Requirement("beacon", "beacon margin", "dB", 3.0, 4.0, 1.0, "width"),
            Requirement("communication", "communication margin", "dB", 3.5, 2.25, -1.25, "the residual: lag"),
        ),
    }
    return ns(**given | changes)


@pytest.fixture
def signs(monkeypatch):
    monkeypatch.setattr(words, "with_sign", lambda text, sources, name: f"{text} <{name}>")
    monkeypatch.setattr(words, "beyond_identified", lambda study, run: "")


@pytest.mark.parametrize(
    ("margins", "said"),
    [
        (
            (-1.5, -2.5, -3.5),
            "The link does not close: beacon −1.50 dB <margin_db.beacon>, answer −2.50 dB <margin_db.answer>, "
            "communication −3.50 dB <margin_db.judged>, at 625 Mbit/s and a simulated residual of 12.1 µrad (rms).",
        ),
        (
            (1.5, -0.01, 0.0),
            "The link does not close: answer −0.01 dB <margin_db.answer>, at 625 Mbit/s and a simulated residual of "
            "12.1 µrad (rms).",
        ),
    ],
)
@pytest.mark.usefixtures("signs")
def test_the_headline_names_each_link_that_does_not_close_and_none_at_0_db(margins, said):
    beacon, answer, judged = margins
    of = words_study(closes=False, beacon=ns(margin_db=beacon), answer=ns(margin_db=answer), margin_db=judged)
    assert words.headline(of) == said


@pytest.mark.usefixtures("signs")
def test_the_headline_of_a_link_that_closes_names_each_requirement_that_is_missed(monkeypatch):
    at = "625 Mbit/s and a simulated residual of 12.1 µrad (rms)"
    of = words_study()
    assert words.headline(of) == (
        "Not every requirement is met: residual (−3 µrad) and communication margin (−1.25 dB). "
        f"The margin is +2.25 dB <margin_db.judged> at {at}."
    )
    unknown = replace(of.requirements[1], unknown="the receiver's noise")
    assert words.headline(words_study(requirements=(unknown,))).startswith(
        "Not every requirement is met: beacon margin (the receiver's noise). The margin"
    )
    monkeypatch.setattr(words, "beyond_identified", lambda study, run: "far")
    met = words_study(requirements=of.requirements[1:2])
    assert words.headline(met) == (
        f"The link closes, with a margin of +2.25 dB <margin_db.judged> at {at}, and every requirement is met. "
        "The mirror model is extrapolated."
    )
    judged = words_study(fine_case=ns(controller="LQG"), requirements=of.requirements[1:2])
    monkeypatch.setattr(words, "time_kept", lambda required: "99.7 % of the time")
    assert words.headline(judged) == (
        "The link closes, with a margin of +2.25 dB <margin_db.judged> at 625 Mbit/s for 99.7 % of the time, and "
        "every requirement is met."
    )


@pytest.mark.parametrize(
    ("missed", "said"),
    [
        ((), "would meet what is required"),
        ((0,), "would miss residual"),
        ((0, 2), "would miss residual and communication margin"),
    ],
)
def test_the_papers_loop_beside_the_judged_one_names_all_that_it_would_miss(missed, said):
    every = words_study().requirements
    judged = [each if k in missed else replace(each, margin=1.0) for k, each in enumerate(every)]
    assert words._papers_loop(words_study(papers_loop=judged)) == (
        f"For comparison alone: the paper's loop (PID, sine of 25 Hz) {said}. It leaves 12.1 µrad (rms) where 9 µrad "
        "is allowed, and a margin of −0.75 dB where 3.50 dB is required."
    )
    assert words._papers_loop(words_study(papers_loop=[])) == ""


def test_what_limits_two_requirements_alike_is_told_once(monkeypatch):
    monkeypatch.setattr(words, "hysteresis_cost", lambda study: "")
    monkeypatch.setattr(words, "found", lambda study: "It is found.")
    of = words_study()
    assert words.explanation(of) == ["What limits it: lag.", "It is found."]
    other = (*of.requirements, replace(of.requirements[1], margin=-1.0), replace(of.requirements[1], unknown="a noise"))
    assert words.explanation(words_study(requirements=other))[0] == "What limits it: lag; width; a noise."
    assert words.explanation(words_study(requirements=())) == ["It is found."]


def test_the_papers_loop_is_told_by_its_peaks_and_rms_beside_the_comparison_model(monkeypatch):
    monkeypatch.setattr(words, "beyond_identified", lambda study, run: "a drive of 3 V" if run.freq_hz == 25.0 else "")
    other = ns(residual=ns(freq_hz=50.0), margin_db=-1.5)
    of = words_study(comparison=other, other_readings=[])
    of.left_rad = lambda run: 1.21e-5 if run.freq_hz == 25.0 else 3.4e-5
    assert words.papers_loop(of) == [
        "As budgeted, at 7.5 µrad, the margin is +4.25 dB; 3.5 dB is required.",
        "The loop (PID, 25 Hz) leaves 25 µrad at its peaks and 16 µrad rms on its axis, times √2 for two equal axes; "
        "9 µrad (rms) is allowed.",
        "Not to be relied on: a drive of 3 V.",
        "On the mission's comparison model of the mirror the residual is 34 µrad and the margin −1.50 dB.",
    ]
    of.comparison, of.residual.freq_hz = None, 50.0
    of.file.mission.jitter, of.file.mission.conventions.residual = object(), "per-axis"
    said = words.papers_loop(of)
    assert said[0].startswith("As budgeted, at 7.5 µrad, the static margin is +4.25 dB;")
    assert len(said) == 2 and "rms on its axis; 9 µrad" in said[1]


def test_hysteresis_costs_the_named_controllers_of_both_loops_and_no_others():
    costs = [
        Cost("sine of 25 Hz", "PID", "given", -1.5, -2e6),
        Cost("sine of 25 Hz", "PI", "given", -2.5, -3e6),
        Cost("sine of 5 Hz", "PID", "given", -3.5, -4e6),
        Cost("sine of 25 Hz", "PID", "comparison", -4.5, -5e6),
        Cost(words.FINE, "LQG", "given", -0.25, math.nan),
        Cost(words.FINE, "PID", "given", -5.5, -6e6),
    ]
    of = words_study(performance=ns(costs=costs, outage=0.003), fine_pointing=ns(best=ns(design=ns(name="LQG"))))
    assert words.hysteresis_cost(of) == (
        f"Hysteresis costs the link 1.50 dB or 2 Mbit/s with PID (sine of 25 Hz) and 0.25 dB with LQG ({words.FINE}), "
        "at the pointing loss that is exceeded 0.3 % of the time."
    )
    of.performance.costs = [replace(costs[0], margin_db=0.0), replace(costs[4], margin_db=0.5)]
    assert words.hysteresis_cost(of) == ""


@pytest.mark.parametrize(
    ("amplitude", "identified", "least", "most", "beyond"),
    [
        (6.0, (0.0, 12.0), 0.0, 180.0, ()),
        (6.5, (0.0, 12.0), -50.0, 500.0, ("the range that the mirror was identified for",)),
        (6.0, (0.0, 12.0), 0.0, 179.0, ("the amplifier's range",)),
        (6.0, (0.0, 12.0), 1.0, 180.0, ("the amplifier's range",)),
        (7.0, (0.0, 12.0), 0.0, 180.0, ("the range that the mirror was identified for", "the amplifier's range")),
        (6.0, (1.0, 12.0), 0.0, 180.0, ("the range that the mirror was identified for",)),
        (6.0, (0.0, 11.0), 0.0, 180.0, ("the range that the mirror was identified for",)),
    ],
)
def test_loops_are_drawn_beyond_what_is_known_of_the_mirror_or_what_its_amplifier_can(
    amplitude, identified, least, most, beyond
):
    m = ns(
        mirror=ns(bias_v=6.0, drive_min_v=identified[0], drive_max_v=identified[1]),
        scenario=ns(loop_amplitude_v=amplitude),
        amplifier=ns(output_min_v=least, gain=15.0, output_max_v=most),
    )
    loops = [ns(freq_hz=5.0, clamped=0), ns(freq_hz=80.0, clamped=3), ns(freq_hz=0.5, clamped=1)]
    assert words._of_loops(ns(file=ns(mission=m), loops=loops)) == [
        *(f"the hysteresis loops are drawn for a drive beyond {each}" for each in beyond),
        "hysteresis loop at 80 Hz: 3 samples beyond the identified rate",
        "hysteresis loop at 0.5 Hz: 1 sample beyond the identified rate",
    ]


def test_each_run_has_its_own_counts_and_those_of_the_inverse_are_added(monkeypatch):
    monkeypatch.setattr(words, "beyond_identified", lambda study, run: "b is far" if run.trace.name == "b" else "")
    first = ns(clamped=2, inverse_clamped=3, saturated=0, slew_limited=7, alternating=0)
    second = ns(clamped=0, inverse_clamped=1, saturated=4, slew_limited=0, alternating=9)
    runs = [ns(trace=ns(name="a", counts=first)), ns(trace=ns(name="b", counts=second))]
    assert words._of_runs(ns(runs=runs)) == [
        "b is far",
        "a: 5 steps beyond the identified rate",
        "a: 7 slew-limited steps",
        "b: 1 step beyond the identified rate",
        "b: 4 saturated samples",
        "b: 9 reversals of the command within 10 samples of the last",
    ]


def test_a_warning_of_a_distance_costs_by_the_range_of_its_own_link():
    """A range of twice, of ten times and of half of what each link is budgeted for."""
    m = ns(communication="c", beacon="b", answer="a", range_m=lambda of: {"c": 2e7, "b": 4e6, "a": 8e7}[of])
    texts = ("beacon.distance is short", "answer.distance is long", "communication.distance is short", "of the beacon")
    day = ns(encounters=[ns(range_most_m=4e7), ns(range_most_m=1e7)], warnings=texts)
    found = words._of_day(ns(file=ns(mission=m), day=day))
    assert [each.text for each in found] == list(texts)
    assert [each.cost_db for each in found] == pytest.approx([20.0, -6.0206, 6.0206, 0.0], abs=1e-4)
    m.beacon = None
    assert next(each.cost_db for each in words._of_day(ns(file=ns(mission=m), day=day))) == 0.0
    assert words._of_day(ns(file=ns(mission=m), day=None)) == []


@pytest.mark.parametrize(
    ("contact", "day", "pattern", "plan", "said"),
    [
        (True, [1], None, None, ["operations.contact is not run"]),
        (True, [], None, None, []),
        (True, None, None, None, []),
        (False, [1], None, None, []),
        (None, [1], object(), None, ["constellation is left out"]),
        (None, None, object(), object(), []),
        (True, [1, 2], object(), None, ["operations.contact is not run", "constellation is left out"]),
    ],
)
def test_a_table_that_the_study_has_no_use_for_is_named(contact, day, pattern, plan, said):
    operations = None if contact is None else ns(contact=object() if contact else None)
    of = ns(
        file=ns(mission=ns(operations=operations, constellation=pattern)),
        contact=None,
        day=None if day is None else ns(relay=ns(contacts=day)),
        plan=plan,
    )
    assert [each.partition(":")[0] for each in words._not_run(of)] == said
    of.contact = object()
    assert [each.partition(":")[0] for each in words._not_run(of)] == [each for each in said if "contact" not in each]


# ------------------------------------------------------------------------ what contributes most, of several each unlike
def of_requirement(subject, limited_by="x", **changes):
    return replace(Requirement(subject, subject, "rad", 1e-5, 2e-5, -1e-5, limited_by), **changes)


def test_what_contributes_most_to_the_cone_is_the_line_of_the_largest_share():
    lines = [ns(name="Body", value=2e-4), ns(name="mount", value=7e-5), ns(name="orbit", value=9e-5)]
    of = ns(
        open_loop=ns(lines=lines, variance_shares=(0.25, 0.65, 0.1), reading=ns(half_angle_rad=4.2e-4, coverage=0.876)),
        fine_case=None,
        requirements=(),
    )
    assert requirement_views.contributor(of, of_requirement("cone")) == (
        "Mount: 65 % of the sum of squares, 70 µrad half width; the cone of 420 µrad half angle covers its partner "
        "with a probability of 0.88"
    )
    assert requirement_views.contributor(of, of_requirement("cone", unknown="the noise")) == "The noise"


def test_the_largest_loss_of_each_beam_stands_with_what_moves_its_own_margin():
    def of_beam(name, value):
        return ns(
            name=name, lines=[ns(name="optics", unit="dB", value=-1.0), ns(name="Splice", unit="dB", value=value)]
        )

    tornados = [ns(of="Answer", swings=[a_swing("a.a", "W", 1.5)]), ns(of="Beacon", swings=[a_swing("b.b", "dB", 2.5)])]
    of = ns(
        beacon=of_beam("Beacon", -3.0),
        answer=of_beam("Answer", -0.5),
        links=ns(tornados=tornados),
        fine_case=None,
        requirements=(),
    )
    found = [requirement_views.contributor(of, of_requirement(subject)) for subject in ("beacon", "answer")]
    assert found == [
        "Splice 3.00 dB; the margin moves most with b.b: 2.50 dB for ±0.5 dB",
        "Optics 1.00 dB; the margin moves most with a.a: 1.50 dB for ±10 %",
    ]
    of.links.tornados = tornados[1:]
    assert requirement_views.contributor(of, of_requirement("answer")) == "Optics 1.00 dB"


def test_the_residual_stands_beside_that_of_the_same_loop_at_the_same_frequency_without_hysteresis():
    def a_run(mirror, controller, freq_hz, left_rad):
        return ns(mirror=mirror, controller=controller, freq_hz=freq_hz, left=left_rad)

    judged = a_run("given", "PID + inverse", 50.0, 8e-6)
    runs = [
        a_run(Variant.STRAIGHT, "PID", 50.0, 1e-6),
        a_run(Variant.STRAIGHT, "PID + inverse", 5.0, 2e-6),
        a_run(Variant.GIVEN, "PID + inverse", 50.0, 3e-6),
        a_run(Variant.STRAIGHT, "PID + inverse", 50.0, 4e-6),
    ]
    of = ns(residual=judged, runs=[judged, *runs], left_rad=lambda run: run.left, fine_case=None, requirements=())
    found = requirement_views.contributor(of, of_requirement("residual", "lag"))
    assert found == "Lag: 8 µrad with hysteresis, 4 µrad without"


@pytest.mark.parametrize("fine", [True, False])
def test_the_pointing_loss_of_the_link_is_that_of_the_judged_case_or_of_the_papers_loop(fine):
    """A requirement of the paper's loop, which stands beside the judged ones, is told of its own loss."""
    own, papers = of_requirement("communication", "OLYMPUS"), of_requirement("communication", "lag")
    of = ns(
        achieved=ns(loss_db=lambda *lines: 1.25),
        tornado=ns(swings=[a_swing("a.b", "W", 0.5)]),
        fine_case=ns(outage_loss_db=2.5) if fine else None,
        requirements=(own,),
    )
    moved = "; the margin moves most with a.b: 0.50 dB for ±10 %"
    found = [requirement_views.contributor(of, each) for each in (own, papers)]
    if fine:
        assert found == [
            f"Vibration (OLYMPUS), pointing loss 2.50 dB at the outage{moved}",
            "Lag, pointing loss 1.25 dB",
        ]
    else:
        assert found == [f"OLYMPUS, pointing loss 1.25 dB{moved}", f"Lag, pointing loss 1.25 dB{moved}"]


@pytest.mark.parametrize(
    ("cause", "said"),
    [
        ("OLYMPUS", "Vibration (OLYMPUS): 3 µrad of 5 µrad rms with hysteresis, 36 % of the sum of squares"),
        ("hysteresis", "Hysteresis: 4 µrad of 5 µrad rms with hysteresis, 64 % of the sum of squares"),
    ],
)
def test_a_part_of_the_fine_loop_is_one_of_those_alone_or_of_those_left_out(cause, said):
    parts = [ns(name="noise", rms_rad=1e-6), ns(name="OLYMPUS", rms_rad=3e-6)]
    differences = [ns(name="quantisation", added_rad=2e-6), ns(name="hysteresis", added_rad=4e-6)]
    budget = ns(parts=parts, differences=differences, full_rad=5e-6)
    of = ns(fine_pointing=ns(budget=budget), fine_case=None, requirements=())
    assert requirement_views.contributor(of, of_requirement("fine pointing", cause)) == said


def test_the_stroke_is_of_the_axis_with_the_least_to_spare():
    study_of = stroke_study(margin_rad=-5e-5)
    for each, total in zip(study_of.fine_pointing.scene.own_stroke, (9e-4, 4e-4), strict=True):
        each.total_rad = total
    study_of.fine_case, study_of.requirements = None, ()
    found = requirement_views.contributor(study_of, of_requirement("stroke", "body pointing"))
    assert found == "Body pointing: 300 µrad of the 400 µrad needed at the line of sight"


def test_a_stroke_of_which_nothing_would_be_left_is_advised_of_the_mirror():
    """The largest line is 300 µrad; the mirror moves half as far as the line of sight: 150 µrad lack in all of it."""
    missed = of_requirement("stroke")
    at = requirement_views.advice(stroke_study(margin_rad=-1.5e-4), missed)
    assert at == "; to meet it, raise mirror.travel"
    of = stroke_study(margin_rad=-5e-5)
    of.fine_pointing.scene.own_stroke[1].lines[0].name = "Wheel"
    assert requirement_views.advice(of, missed) == "; to meet it, raise mirror.travel"


@pytest.mark.parametrize(
    ("name", "said"),
    [
        (requirement_views.OPTICAL_NOISE, "change fine_pointing.optical_sensor"),
        (requirement_views.GAUGE_NOISE, "change fine_pointing.strain_gauge"),
        ("a", "raise fine_pointing.rate"),
    ],
)
def test_a_source_of_the_loop_is_advised_by_what_it_is(name, said):
    """Also where a source of the same name is stated; several that are correlated have no advice."""
    missed = of_requirement("error budget")
    stated = {name: ns(kind="random", size_rad=1e-6)}
    share = ns(name=name, allowed=0.5, contribution=ns(kind="loop"))
    of = ns(
        requirements=[missed],
        error_budget=ns(judged=[ns(shares=[share])]),
        file=ns(mission=ns(error_budget=ns(sources=stated))),
    )
    assert requirement_views.advice(of, missed) == f"; to meet it, {said}"
    share.contribution.kind, share.name = "random", "a and b"
    assert requirement_views.advice(of, missed) == ""


# ------------------------------------------------------------------------------------------ what only some pages have
@pytest.mark.parametrize(
    ("ahead", "fine", "said"),
    [
        (None, True, None),
        (ns(corrected=False, error_rad=2e-6), True, None),
        (ns(corrected=True, error_rad=0.0), True, None),
        (ns(corrected=True, error_rad=2e-6), False, ""),
        (ns(corrected=True, error_rad=2e-6), True, ": at most 1.25 dB more for the best loop"),
    ],
)
def test_what_a_correction_of_the_point_ahead_leaves_costs_the_best_loop_by_the_beams_fall(ahead, fine, said):
    """A beam that loses 1 dB a square of 4 µrad: from 4 µrad, which the outage's loss is, to 6 µrad."""
    asked = []
    fall = ns(loss_db=lambda rad: (rad / 4e-6) ** 2, error_rad=lambda db: 4e-6 * math.sqrt(db))
    cases = ns(case=lambda *of: asked.append(of) or ns(outage_loss_db=1.0))
    of = ns(
        file=ns(mission=ns(point_ahead=ahead)),
        links=ns(data=ns(beam=ns(fall=fall))),
        fine_pointing=ns(best=ns(design=ns(name="LQG"))) if fine else None,
        performance=cases,
    )
    expected = (
        [] if said is None else [f"What the correction of point-ahead leaves (2 µrad) is not in these errors{said}."]
    )
    assert page._left_out(of) == expected
    assert asked == ([(page.FINE, "LQG", Variant.GIVEN)] if said else [])
    of.performance.case = lambda *which: None
    assert page._left_out(of) == [each.replace(f"errors{said}", "errors") for each in expected]


@pytest.mark.parametrize(
    ("fine", "light", "angle", "said"),
    [(True, True, True, True), (False, True, True, False), (True, False, True, False), (True, True, False, False)],
)
def test_the_noise_of_the_loop_stands_beside_what_the_light_allows_where_both_are_known(fine, light, angle, said):
    of = ns(
        links=ns(tracking=ns(noise_equivalent_angle=ns(value=3.456e-7) if angle else None) if light else None),
        fine_pointing=ns(scene=ns(loop=ns(optical=ns(noise_rad=5e-7)))) if fine else None,
    )
    words_of = (
        "The fine-pointing loop is simulated with 500 nrad of noise in its optical sensor; that light allows 346 nrad."
    )
    found = page._loop_noise(of)
    assert found == ([words_of] if said else [])


def test_the_link_is_shown_under_each_error_but_those_of_a_mirror_without_hysteresis(monkeypatch):
    monkeypatch.setattr(page, "performance_view", lambda *given: given)
    monkeypatch.setattr(page, "residuals_sentence", lambda found: "a sentence")
    monkeypatch.setattr(page, "_left_out", lambda study: ["left out"])
    mirrors = (Variant.STRAIGHT, Variant.GIVEN, Variant.COMPARISON, Variant.STRAIGHT, Variant.GIVEN)
    cases = [ns(mirror=mirror, k=k) for k, mirror in enumerate(mirrors)]
    of = ns(
        performance=ns(cases=cases, costs="costs", outage=0.003),
        links=ns(under_jitter=ns(k="jitter")),
        fine_pointing=ns(best=ns(design=ns(name="LQG"))),
    )
    shown, *others = page.cost_view(of)
    assert [each.k for each in shown] == ["jitter", 1, 2, 4]
    assert others == ["costs", 0.003, ["a sentence", "left out"], "LQG"]
    of.links.under_jitter = of.fine_pointing = None
    shown, *others = page.cost_view(of)
    assert ([each.k for each in shown], others[-1]) == ([1, 2, 4], "")


@pytest.mark.parametrize(("rates", "rate"), [(None, 4e8), ((), None), ((1e8, 2e8), None)])
def test_a_contact_has_one_rate_unless_it_is_stepped_with_range(monkeypatch, rates, rate):
    seen = []
    monkeypatch.setattr(page, "contact_sentences", lambda *given: seen.append(given) or ["told"])
    monkeypatch.setattr(page, "windows_table", lambda run, quantile: f"windows of {run} at {quantile}")
    monkeypatch.setattr(page, "transitions_table", lambda run: f"transitions of {run}")
    operations = ns(contact=ns(number=3), rates_bit_s=rates)
    day = ns(operations=operations, data=ns(table=ns(data_rate_bit_s=4e8)))
    of = ns(contact="run", fine_pointing=ns(best=ns(design=ns(name="LQG")), quantile=0.997))
    view = page._contact(of, day)
    assert seen == [("run", 3, "LQG", rate)]
    assert (list(view.blocks), view.folded) == (["told", "windows of run at 0.997", "transitions of run"], True)
    for lacking in (ns(contact=None, rates_bit_s=None), None):
        assert page._contact(of, ns(operations=lacking, data=day.data)) is None
    assert page._contact(ns(contact=None, fine_pointing=of.fine_pointing), day) is None
    assert page._contact(ns(contact="run", fine_pointing=None), day) is None


def test_the_chain_of_a_fine_loop_has_its_disturbances_of_all_axes_its_residual_and_its_worst_stroke(monkeypatch):
    """Two axes of one and two disturbances: 3, 4 and 12 µrad."""
    monkeypatch.setattr(chain, "output_amplitude", lambda model, half_v: 1e-4 * half_v)
    monkeypatch.setattr(chain, "with_sign", lambda text, sources, name: f"{text} <{name}>")
    monkeypatch.setattr(chain, "Scene", SimpleNamespace)
    disturbances = ([ns(rms_rad=3e-6)], [ns(rms_rad=4e-6), ns(rms_rad=12e-6)])
    strokes = [
        ns(name="x", margin_rad=2e-4, needed_rad=3e-4, available_rad=5e-4),
        ns(name="y", margin_rad=-1e-4, needed_rad=4e-4, available_rad=3e-4),
    ]
    design = ns(name="LQG", loop_margins=ns(modulus=0.5, bandwidth_hz=321.0))
    simulated = {Variant.STRAIGHT: ns(quantile_rad=1e-6), Variant.GIVEN: ns(quantile_rad=7.5e-6)}
    fine = ns(
        best=ns(design=design, simulated=simulated),
        quantile=0.997,
        scene=ns(loop=ns(disturbances=disturbances, timing=ns(period_s=1e-4)), own_stroke=strokes),
    )
    judged = (("cone", "PASS"), ("stroke", "FAIL"), ("fine pointing", "PASS"), ("residual", "FAIL"))
    of = chain_study(
        fine_pointing=fine,
        fine_case=object(),
        requirements=[ns(subject=subject, mark=mark, met=mark == "PASS") for subject, mark in judged],
    )
    boxes = {box.name: (list(box.lines), box.mark) for box in chain.stages(of)}
    assert boxes["Pointing"][0][2:] == ["disturbed by 13 µrad rms", "fine: 9 µrad allowed"]
    lines, mark = boxes["Mirror"]
    assert (lines[0], lines[-2:], mark) == (
        "reach 1.2 mrad over 12 V",
        ["stroke (y): 400 µrad needed,", "300 µrad available <fine_pointing.stroke.x.available_rad>"],
        "FAIL",
    )
    assert boxes["Residual"] == (
        [
            "7.50 µrad <fine_pointing.simulated.given.quantile_rad> at 99.7 %, vibration",
            "(12.1 µrad peak, 25 Hz sine)",
            "allowed 9 µrad",
        ],
        "FAIL",
    )
    assert boxes["Verdict"][0][:2] == ["2 of 4 requirements met", "link at the outage −1.12 dB <margin_db.judged>,"]


def a_claim(where, agrees="yes"):
    return ns(where=where, claim=f"claim of {where}", ours="ours", agrees=agrees, why="why")


def test_the_claims_of_a_figure_are_those_that_name_its_number_behind_the_word():
    places = ("section 5, Fig. 8", "Fig. 6, 8", "Fig. 18", "section 8", "Table 8", "Fig. 5 and 6", "section 6, Fig. 4")
    of = ns(claims=[a_claim(where) for where in places])

    def told(number):
        table = paper_views._claims_of(of, number)
        return None if table is None else [row[0] for row in table.rows]

    assert told("Fig. 8") == ["section 5, Fig. 8", "Fig. 6, 8"]
    assert told("Fig. 5") == ["Fig. 5 and 6"]
    assert told("Fig. 6") == ["Fig. 6, 8", "Fig. 5 and 6"]
    assert told("Fig. 1") is None


def test_the_claims_are_counted_by_whether_they_agree_the_most_first_and_each_change_is_named(monkeypatch):
    changed = [("a.b", '"6 cm"', '"5 cm"'), ("c.d", '"2 W"', '"5 W"')]
    monkeypatch.setattr(paper_views, "changed_from_shipped", lambda sources: changed)
    agrees = ("no", "yes", "inferred", "yes", "no", "yes")
    of = ns(claims=[a_claim(f"Fig. {k}", each) for k, each in enumerate(agrees)], file=ns(sources={}))
    view = paper_views.claims_view(of)
    (table,) = (block for block in view.blocks if isinstance(block, Table))
    assert table.folded == "6 claims; whether they agree: 3 yes, 2 no, 1 inferred"
    assert [str(cell) for cell in table.rows[2]] == ["Fig. 2", "claim of Fig. 2", "ours", "inferred", "why"]
    assert 'This mission is not the paper\'s: a.b is "6 cm", there "5 cm"; c.d is "2 W", there "5 W".' in view.blocks


@pytest.mark.parametrize(("left", "said"), [(1.5, None), (1.51, "1.51"), (0.5, None)])
def test_a_loop_that_leaves_more_than_half_as_much_again_as_its_theory_is_warned_of(left, said):
    def of(fine=True, table=True, with_loop=True):
        best = ns(
            design=ns(name="LQG"),
            simulated={Variant.STRAIGHT: ns(rms_rad=9e-6), Variant.GIVEN: ns(rms_rad=left * 2.0**-18)},
            theory=ns(radial_rms_rad=2.0**-18),
        )
        mission = ns(error_budget=ns(with_loop=with_loop) if table else None)
        return ns(fine_pointing=ns(best=best) if fine else None, file=ns(mission=mission))

    found = words._of_budget_loop(of())
    text = f"the error budget takes the loop by its linear theory; simulated, it leaves {said} times as much rms"
    assert [(each.text, each.about, each.cost_db) for each in found] == ([(text, "error budget", 0.0)] if said else [])
    (told,) = words.loop_in_budget(of())
    assert told.startswith("In all, LQG leaves 3.81 µrad rms by that theory, and ")
    for lacking in ({"fine": False}, {"table": False}, {"with_loop": False}):
        assert words._of_budget_loop(of(**lacking)) == words.loop_in_budget(of(**lacking)) == []


def test_the_requirement_nearest_to_its_limit_is_told_as_met_missed_or_unknown(monkeypatch):
    monkeypatch.setattr(words.contributors, "contributor", lambda study, r: f"most of {r.name}")
    monkeypatch.setattr(words.contributors, "advice", lambda study, r: f"; mend {r.name}")
    near = Requirement("beacon", "beacon margin", "dB", 3.0, 3.5, 0.5, "width")
    far = Requirement("answer", "answer margin", "dB", 3.0, 9.0, 6.0, "width")
    assert words._limit(words_study(requirements=(far, near))) == (
        "Nearest to its limit is the beacon margin. Most of beacon margin; mend beacon margin."
    )
    missed = replace(far, actual=2.0, margin=-1.0)
    assert words._limit(words_study(requirements=(near, missed))) == (
        "What limits it is the answer margin. Most of answer margin; mend answer margin."
    )
    unknown = replace(near, unknown="the receiver's noise")
    assert words._limit(words_study(requirements=(far, unknown))) == (
        "Nothing can be said of the beacon margin: the receiver's noise."
    )


def test_what_is_told_in_short_leaves_out_what_there_is_nothing_of(monkeypatch):
    """A drive beyond what is known of the mirror stands in the place of the weightiest warning."""
    monkeypatch.setattr(words, "limits", lambda study: ["margin", "limit"])
    monkeypatch.setattr(words, "warnings", lambda study: ["first", "second"])
    monkeypatch.setattr(words, "_papers_loop", lambda study: "loop" if study.day else "")
    monkeypatch.setattr(words.day_words, "headline", lambda day: [f"headline of {day}", "more"])
    monkeypatch.setattr(words, "beyond_identified", lambda study, run: "far")
    loop = words_study()
    assert words.short(loop) == ["margin", "limit", "Not to be relied on: far."]
    fine = words_study(fine_case=ns(controller="LQG"), day="a day")
    assert words.short(fine) == [
        "margin",
        "limit",
        "Warning 1 of 2 (all by --verbose): first.",
        "headline of a day",
        "loop",
    ]
    monkeypatch.setattr(words, "warnings", lambda study: [])
    assert words.short(fine) == ["margin", "limit", "headline of a day", "loop"]


@pytest.mark.parametrize(
    ("met", "fine", "beyond", "good"),
    [
        (True, True, "far", True),
        (True, False, "far", False),
        (True, False, "", True),
        (False, True, "", False),
    ],
)
def test_a_verdict_is_good_where_all_is_met_and_the_judged_mirror_is_known(monkeypatch, met, fine, beyond, good):
    monkeypatch.setattr(words, "headline", lambda study: "a headline")
    monkeypatch.setattr(words.contributors, "judged_table", lambda study, found: f"table of {len(found)}")
    monkeypatch.setattr(words, "beyond_identified", lambda study, run: beyond if run is study.residual else "")
    derived = replace(words_study().requirements[1], derived=("a.b = 3 dB: from the margin",))
    of = words_study(met=met, fine_case=object() if fine else None, requirements=(derived, derived))
    box = words.verdict_box(of)
    assert (box.headline, box.good) == ("a headline", good)
    assert list(box.blocks) == [
        "table of 2",
        "Derived, so that meeting it proves nothing: a.b = 3 dB: from the margin.",
    ]


def test_inputs_that_are_assumed_inferred_or_changed_are_found_by_their_rows(monkeypatch):
    """Changed is one by its value, one by a comment of another value, and one that nothing shipped has."""
    monkeypatch.setattr("microrad.mission.file.changed_from_shipped", lambda sources: (("z.e", "5", "4"),))
    monkeypatch.setattr("microrad.mission.origins.is_shipped", lambda key, value: (key, value) != ("z.d", "4"))
    given = {
        "mirror.uncertainty.correlation": Source(1, "assumption: many", "[1]"),
        "z.a": Source(2, "assumption: a", "1"),
        "z.b": Source(3, "derived: from a", "2"),
        "z.c": Source(4, "assumption: of 7", "3", was="7"),
        "z.d": Source(5, "", "4"),
        "z.e": Source(6, "[1] Table 2", "5"),
    }
    view = inputs_view(given)
    (table,) = view.blocks
    assert (view.title, view.anchor, table.words) == ("Assumptions and inputs", "assumptions", (0, 1, 2))
    assert dict(table.filters) == {
        "assumptions": [0, 2],
        "inferred from others": [1],
        "changed from what is shipped": [2, 3, 4],
    }
    assert table.folded == (
        "All 5 inputs with their sources: 2 assumptions, 1 inferred from others, 3 changed from what is shipped"
    )
    assert [(cell.text, cell.code, value, said) for cell, value, said in table.rows] == [
        ("z.a", True, "1", "assumption: a"),
        ("z.b", True, "2", "derived: from a"),
        ("z.c", True, "3", "mission file, line 4, in place of 7 (assumption: of 7)"),
        ("z.d", True, "4", "mission file, line 5"),
        ("z.e", True, "5", "[1] Table 2"),
    ]


@pytest.mark.parametrize(("residual", "allowed"), [("radial", 3.0 / math.sqrt(2.0)), ("per-axis", 3.0)])
def test_the_papers_error_is_held_against_the_share_of_one_axis_where_the_limit_is_radial(residual, allowed):
    panel, ns = Panel(0, 0), SimpleNamespace
    mission = ns(conventions=ns(residual=residual), requirement=ns(pointing_error_rad=3e-6))
    paper_figures._limit(panel, mission)
    assert [(rule.at, rule.upright) for rule in panel.all_of(Rule)] == [
        (pytest.approx(-allowed), False),
        (pytest.approx(allowed), False),
    ]


@pytest.mark.parametrize(("ahead", "said"), [(None, "narrow beam back"), (object(), "narrow beam back, point-ahead")])
def test_the_sequence_names_both_divergences_the_point_ahead_where_there_is_one_and_the_rate(ahead, said):
    ns = SimpleNamespace
    mission = ns(
        beacon=ns(divergence_rad=750e-6),
        answer=ns(divergence_rad=40e-6),
        point_ahead=ahead,
        communication=ns(data_rate_bit_s=2.5e9),
    )
    assert drawings._sequence(mission) == ["wide beacon, 750 µrad", "answer, 40 µrad", said, "lock; 2.5 Gbit/s"]


def tracked(mirror, controller, freq_hz, k):
    """A run of two axes whose steady part begins at its second sample, with numbers of its own."""
    along = np.arange(4.0)
    trace = ns(
        steady=slice(1, 4),
        time_s=0.25 + 1e-3 * along * k,
        error_rad=1e-6 * np.stack([k + along, -100.0 - along], axis=1),
        peak_rad=1e-6 * (k + 0.3),
        rms_rad=1e-6 * (k + 0.2),
        counts=ns(clamped=k, inverse_clamped=100 * k, saturated=k + 1, slew_limited=k + 2, alternating=k + 3),
    )
    return ns(mirror=mirror, controller=controller, freq_hz=freq_hz, trace=trace)


def tracking_study(residual="radial"):
    """A study with a run of either controller on each mirror at three frequencies."""
    kinds = [(m, c) for m in (Variant.COMPARISON, Variant.STRAIGHT, Variant.GIVEN) for c in (PID_WITH_INVERSE, PID)]
    runs = [tracked(*kind, f, 1 + 3 * n + k) for n, kind in enumerate(kinds) for k, f in enumerate((20.0, 1.5, 15.0))]
    mission = ns(
        scenario=ns(pid_frequencies_hz=(1.5, 15.0), inverse_frequencies_hz=(15.0, 20.0), amplitude_rad=2.5e-4),
        requirement=ns(pointing_error_rad=1e-5),
        conventions=ns(residual=residual),
    )
    return ns(file=ns(mission=mission), runs=runs)


def test_errors_under_the_controller_are_drawn_on_the_mirror_and_on_one_without_hysteresis():
    lines = figure_of(paper_figures.tracking_errors(tracking_study()))
    assert lines[:3] == [
        "fig6-pid",
        "Fig. 6  PID with and without hysteresis",
        "Tracking error of a 250 µrad sine under PID, on the mirror and on one of the same gain without hysteresis.",
    ]
    assert lines[3] == {
        "time, with hysteresis, 1.5 Hz (s)": [0.0, 0.017, 0.034],
        "error, with hysteresis, 1.5 Hz (rad)": [1.8e-5, 1.9e-5, 2e-5],
        "time, without, 1.5 Hz (s)": [0.0, 0.011, 0.022],
        "error, without, 1.5 Hz (rad)": [1.2e-5, 1.3e-5, 1.4e-5],
        "time, with hysteresis, 15 Hz (s)": [0.0, 0.018, 0.036],
        "error, with hysteresis, 15 Hz (rad)": [1.9e-5, 2e-5, 2.1e-5],
        "time, without, 15 Hz (s)": [0.0, 0.012, 0.024],
        "error, without, 15 Hz (rad)": [1.3e-5, 1.4e-5, 1.5e-5],
    }
    assert "\n".join(lines[4:]) == one_text("""
Sheet width=7.8 height=3.5 widths=[1 1]
Panel 0 0 x=<title=time, steady state (ms)> y=<title=pointing error (µrad)> title=1.5 Hz
  legend=<place=above size=7.5>
Line x=[0 17 34] y=[18 19 20] colour=#D55E00 dash=-- width=1.6 label=with hysteresis: peak 17.3,
  rms 17.2 µrad
Line x=[0 11 22] y=[12 13 14] colour=#0072B2 label=without: peak 11.3, rms 11.2 µrad
Panel 0 1 x=<title=time, steady state (ms)> y=<title=pointing error (µrad)> title=15 Hz
  legend=<place=above size=7.5>
Line x=[0 18 36] y=[19 20 21] colour=#D55E00 dash=-- width=1.6 label=with hysteresis: peak 18.3,
  rms 18.2 µrad
Line x=[0 12 24] y=[13 14 15] colour=#0072B2 label=without: peak 12.3, rms 12.2 µrad
""")


def test_the_inverse_is_drawn_beside_the_controller_alone_with_the_limit_and_its_own_counts():
    lines = figure_of(paper_figures.inverse(tracking_study()))
    assert lines[:3] == [
        "fig8-inverse",
        "Fig. 8  PID against PID + inverse",
        "Tracking error of a 250 µrad sine. The feedforward inverts the hysteresis model, driven by the reference and "
        "its rate. Dotted: the required 10 µrad. Counts of PID + inverse: "
        "20 Hz 1313 rate-clamped, 14 saturated, 15 slew-limited, 16 alternating; "
        "1.5 Hz 1414 rate-clamped, 15 saturated, 16 slew-limited, 17 alternating; "
        "15 Hz 1515 rate-clamped, 16 saturated, 17 slew-limited, 18 alternating.",
    ]
    assert list(lines[3]) == [
        f"{what}, {label}, {f} Hz ({unit})"
        for f in (15, 20)
        for label in ("PID", "PID + inverse")
        for what, unit in (("time", "s"), ("error", "rad"))
    ]
    assert "\n".join(lines[4:]) == one_text("""
Sheet width=7.8 height=3.5 widths=[1 1]
Panel 0 0 x=<title=time, steady state (ms)> y=<title=pointing error (µrad)> title=15 Hz
  legend=<place=above size=7.5>
Line x=[0 18 36] y=[19 20 21] colour=#D55E00 dash=-- width=1.6 label=PID: peak 18.3, rms 18.2
  µrad
Line x=[0 15 30] y=[16 17 18] colour=#0072B2 label=PID + inverse: peak 15.3, rms 15.2 µrad
Rule at=-7.07107 upright=False dash=: width=0.9
Rule at=7.07107 upright=False dash=: width=0.9
Panel 0 1 x=<title=time, steady state (ms)> y=<title=pointing error (µrad)> title=20 Hz
  legend=<place=above size=7.5>
Line x=[0 16 32] y=[17 18 19] colour=#D55E00 dash=-- width=1.6 label=PID: peak 16.3, rms 16.2
  µrad
Line x=[0 13 26] y=[14 15 16] colour=#0072B2 label=PID + inverse: peak 13.3, rms 13.2 µrad
Rule at=-7.07107 upright=False dash=: width=0.9
Rule at=7.07107 upright=False dash=: width=0.9
""")


@pytest.mark.parametrize(("residual", "allowed"), [("radial", 7.0710678118654755), ("per axis", 10.0)])
def test_both_models_of_hysteresis_are_drawn_each_with_its_own_inverse(residual, allowed):
    found = paper_figures.comparison(tracking_study(residual))
    assert (found.name, found.title) == ("comparison", "Hysteresis models compared")
    assert "on the mirror as given and on the mission's comparison model, each with its own inverse" in found.caption
    assert [panel.title for panel in found.sheet.panels] == ["15 Hz", "20 Hz"]
    for panel, firsts in zip(found.sheet.panels, ((16.0, 4.0), (14.0, 2.0)), strict=True):
        assert [(line.label.split(":")[0], round(float(line.y[0]), 9)) for line in panel.all_of(Line)] == [
            ("mirror's model", firsts[0]),
            ("comparison model", firsts[1]),
        ]
        assert [rule.at for rule in panel.all_of(Rule)] == pytest.approx([-allowed, allowed], rel=1e-9)
    assert found.columns["error, comparison model, 20 Hz (rad)"] == pytest.approx([2e-6, 3e-6, 4e-6], rel=1e-9)


def test_loops_of_three_frequencies_are_drawn_about_the_bias_with_their_widths():
    drive, output, left = (np.array(each) for each in ([-1.0, 0.0, 1.0], [-2e-3, 5e-4, 2e-3], [-3e-6, 3e-5, 3e-6]))
    loops = [
        ns(freq_hz=f, drive_v=k * drive, output_rad=k * output, hysteresis_rad=k * left, width=0.1234 * k)
        for k, f in enumerate((0.5, 80.0, 25.0), start=1)
    ]
    lines = figure_of(paper_figures.hysteresis_loops(ns(file=ns(mission=ns(mirror=ns(bias_v=6.0))), loops=loops)))
    assert lines[:2] == ["fig5-hysteresis-loops", "Fig. 5  Rate-dependent hysteresis"]
    assert lines[2].startswith("Settled loops of the hysteresis model alone, without the linear part.")
    assert lines[3] == {
        "drive at 0.5 Hz (V)": [5.0, 6.0, 7.0],
        "output at 0.5 Hz (rad)": [-0.002, 0.0005, 0.002],
        "hysteresis at 0.5 Hz (rad)": [-3e-6, 3e-5, 3e-6],
        "drive at 80 Hz (V)": [4.0, 6.0, 8.0],
        "output at 80 Hz (rad)": [-0.004, 0.001, 0.004],
        "hysteresis at 80 Hz (rad)": [-6e-6, 6e-5, 6e-6],
        "drive at 25 Hz (V)": [3.0, 6.0, 9.0],
        "output at 25 Hz (rad)": [-0.006, 0.0015, 0.006],
        "hysteresis at 25 Hz (rad)": [-9e-6, 9e-5, 9e-6],
    }
    assert "\n".join(lines[4:]) == one_text("""
Sheet width=7.4 height=3.6 widths=[1 1]
Panel 0 0 x=<title=drive (V)> y=<title=output about the bias (mrad)> legend=<title=drive>
Line x=[5 6 7] y=[-2 0.5 2] label=0.5 Hz
Line x=[4 6 8] y=[-4 1 4] colour=#0072B2 dash=-- label=80 Hz
Line x=[3 6 9] y=[-6 1.5 6] colour=#009E73 dash=-. label=25 Hz
Panel 0 1 x=<title=drive (V)> y=<title=hysteresis h (µrad)> legend=<place=below columns=2
  title=loop width>
Line x=[5 6 7] y=[-3 30 3] label=0.5 Hz: 12.34 %
Line x=[4 6 8] y=[-6 60 6] colour=#0072B2 dash=-- label=80 Hz: 24.68 %
Line x=[3 6 9] y=[-9 90 9] colour=#009E73 dash=-. label=25 Hz: 37.02 %
""")


def test_warnings_are_counted_over_all_groups_and_stand_below_what_each_puts_in_doubt(monkeypatch):
    monkeypatch.setattr(words, "ranked_warnings", lambda study: {"The day": ["a", "b"], "The verdict": ["c"]})
    view = words.warnings_view(None)
    assert (view.title, view.anchor) == ("Warnings (3), the weightiest first", "warnings")
    assert [each if isinstance(each, str) else list(each.lines) for each in view.blocks] == [
        *("The day:", ["a", "b"]),
        *("The verdict:", ["c"]),
    ]
    assert words.warnings(None) == ["a", "b", "c"]
    monkeypatch.setattr(words, "ranked_warnings", lambda study: {})
    view = words.warnings_view(None)
    assert (view.title, list(view.blocks), words.warnings(None)) == ("Warnings", ["None."], [])


def test_warnings_stand_by_doubt_then_a_missed_requirement_then_what_they_cost_then_the_requirement():
    kept = Requirement("beacon", "beacon margin", "dB", 3.0, 4.0, 1.0, "width")
    near, missed = replace(kept, subject="answer", margin=0.5), replace(kept, subject="stroke", actual=1.0, margin=-2.0)
    made = ns(requirements=(kept, near, missed))
    of = words.Warned
    doubt = of("doubt", "verdict")
    ranked = [
        *(doubt, of("missed, 1 dB", "stroke", 1.0), of("missed", "stroke")),
        *(of("2 dB", "", 2.0), of("1 dB", "beacon", 1.0), of("near", "answer"), of("far", "beacon"), of("nothing")),
    ]
    turned = ranked[::-1]
    assert sorted(turned, key=lambda warned: words._weight(made, warned)) == ranked


def test_each_warning_of_each_beam_is_about_its_requirement():
    made = [("Answer", ["a", "b", "c"]), ("Communication", []), ("Beacon", ["d", "e"])]
    budgets = [ns(name=name, warnings=said) for name, said in made]
    found = words._of_links(ns(links=ns(budgets=budgets)))
    assert [(each.text, each.about) for each in found] == [
        *(("a", "answer"), ("b", "answer"), ("c", "answer")),
        *(("d", "beacon"), ("e", "beacon")),
    ]


def test_a_way_to_the_partner_that_is_possible_has_a_probability_however_small():
    def way(name, possible, probability, mean_s):
        return ns(name=name, possible=possible, outcome=ns(success_probability=probability, mean_time_s=mean_s))

    ways = [way("wide beacon", True, 0.0, 2.0), way("scan", False, 0.5, 3.0), way("other", True, 0.25, 4.0)]
    of = ns(links=ns(finding=ns(ways=ways)), open_loop=ns(reading=ns(coverage=0.5)))
    assert words.found(of).startswith(
        "Acquisition, with its retries: the wide beacon locks with a probability of 0.0000, in 2 s on average; the "
        "scan never locks; the other locks with a probability of 0.2500, in 4 s on average. The beacon's cone"
    )


def test_a_part_that_is_left_out_too_counts_by_what_it_adds_to_the_fine_loop():
    parts = [ns(name="delay", rms_rad=3e-6), ns(name="OLYMPUS", rms_rad=1e-6)]
    differences = [ns(name="delay", added_rad=2e-6), ns(name="hysteresis", added_rad=-1e-6)]
    made = ns(fine_pointing=ns(budget=ns(parts=parts, differences=differences, full_rad=4e-6)))
    assert [requirement_views._fine(made, cause) for cause in ("delay", "OLYMPUS", "hysteresis")] == [
        "delay: 2 µrad of 4 µrad rms with hysteresis, 25 % of the sum of squares",
        "vibration (OLYMPUS): 1 µrad of 4 µrad rms with hysteresis, 6.2 % of the sum of squares",
        "hysteresis: −1 µrad of 4 µrad rms with hysteresis, 6.2 % of the sum of squares",
    ]


@pytest.mark.parametrize(
    ("case", "second"), [(None, "at the simulated residual"), (object(), "at the residual of the paper's loop")]
)
def test_the_budgets_of_a_study_stand_in_their_order_with_what_the_second_is_at(monkeypatch, case, second):
    monkeypatch.setattr(page, "paired_tables", lambda one, other, names: [(one, other, *names)])
    monkeypatch.setattr(page, "budget_table", lambda budget: f"table of {budget}")
    monkeypatch.setattr(page, "_judged", lambda study: ["judged"])
    monkeypatch.setattr(page, "_loop_noise", lambda study: ["noise"])
    monkeypatch.setattr(page, "_implied", lambda study: "implied")
    monkeypatch.setattr(page, "cost_view", lambda study: "cost")
    monkeypatch.setattr(page, "budgets_view", lambda *given, warned: given[1:])
    monkeypatch.setattr(page, "links_views", lambda links, figures, budgets, performance: (*budgets, performance))
    made = ns(fine_case=case, communication="c", achieved="a", beacon="beacon", answer="answer", links="links")
    tables = [("c", "a", "as budgeted", second), "table of beacon", "table of answer"]
    assert page._links(made, ("figure",)) == (tables, ("figure",), ["judged", "noise"], "implied", "cost")
