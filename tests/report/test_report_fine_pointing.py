"""The fine-pointing loop in the report: its numbers on the page, in words, as data and in results.nc; its warnings."""

import csv
import json
import math
import re
import tempfile
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import xarray as xr
from numpy.testing import assert_allclose, assert_array_equal

from drawn import figure_of, one_text, outline
from drawn import plain as rounded
from microrad import report
from microrad.loop import control, controller_study
from microrad.loop.control.tuning import MARGIN
from microrad.loop.controller_study import Difference, ErrorBudget, FinePointingStudy, Part, Residual, Sine, Verified
from microrad.loop.disturbance.windows import ErrorIndex
from microrad.loop.pointing_loop.design import design_plant
from microrad.loop.pointing_loop.ensemble import COUNTERS, bin_edges_rad
from microrad.loop.pointing_loop.linear import close, residual_spectrum, stationary
from microrad.loop.pointing_loop.loop import ReferenceFilter, assemble, with_inverse
from microrad.loop.worst_case import Extent, InTime, Quantiles, Sensitivity, Worst, WorstCase
from microrad.report import quantities
from microrad.report.day import figures as day_figures
from microrad.report.fine_pointing import data as plain_data
from microrad.report.fine_pointing import figures, simulated_windows, tails, windows, words, worst_case
from microrad.report.fine_pointing import page as section
from microrad.report.fine_pointing import recording as recorded
from microrad.report.fine_pointing.figures import fine_pointing_figures
from microrad.report.links import figures as link_figures
from microrad.report.paper import bench
from microrad.report.paper import figures as paper_figures
from microrad.report.plotting.sheet import Line, Panel, Rule
from microrad.report.requirements import requirement_table
from microrad.report.results import arrays
from microrad.report.results.arrays import study_netcdf
from microrad.report.results.manifest import manifest_of
from microrad.report.study import chain
from microrad.report.study import contributors as requirement_views
from microrad.report.study import page as report_page
from microrad.report.study import words as study_words
from microrad.report.study.data import summary
from microrad.report.study.page import StudyFigures
from microrad.report.view import views_text
from microrad.study import pointing_penalty as performance
from microrad.study import study
from scenes import scene_of
from shipped import plain_study

REQUIRED_RAD = 10e-6  # of the shipped mission
HEADING = "Fine pointing under vibration and noise"
HEADINGS = ("h2", "h3", "h4")
VARIANTS = ("given", "comparison", "no hysteresis")
STROKE = "The stroke line by line"
SECOND, THIRD = "PI + inverse in series", "quick PI"


def warned(fine, m):
    """What a reader of the fine-pointing loop is warned of."""
    own, others = words.warnings(fine, m.control, m.amplifier)
    return [*own, *others]


@pytest.fixture(scope="module")
def file():
    return plain_study().file


@pytest.fixture(scope="module")
def mission(file):
    return file.mission


@pytest.fixture(scope="module")
def plain():
    """The study of the shipped mission but for its fine-pointing loop."""
    return plain_study()


@pytest.fixture(scope="module")
def fine(file):
    return made_up(file)


def made_up(file):
    """A study of three controllers in the mission's own loop; what they leave is made up, each number unlike others."""
    scene = scene_of(file)
    freq = np.linspace(0.0, 0.5 / scene.loop.timing.period_s, 129)
    plant, path, made = design_plant(scene.axis), ReferenceFilter(1000.0), []
    for name, gains in ((controller_study.BASELINE, (150.0, 400.0)), (SECOND, (120.0, 300.0)), (THIRD, (190.0, 500.0))):
        axis = control.PI.build(plant, np.array(gains))
        values, margins = (
            dict(zip(("integral frequency", "zero"), gains, strict=True)),
            control.loop_margins(plant, axis),
        )
        tuned = control.Tuned(axis, values, 1e-6, 1e-6, 1e-6, margins, margins.modulus, margins.bandwidth_hz, 1, ())
        if name == SECOND:
            loop = with_inverse(name, scene.loop, axis, control.inverse(scene.loop.mirror), path, True)
        else:
            loop = assemble(name, scene.loop, axis)
        made.append(controller_study.Design(name, tuned, loop, "in series" if name == SECOND else ""))
    verified = tuple(verified_of(scene, design, i, freq) for i, design in enumerate(made))
    budget = ErrorBudget(
        SECOND,
        (Part("OLYMPUS", 3.0e-6, 3.1e-6), Part("body pointing", 0.4e-6, 0.41e-6), Part("quantisation", 0.0, math.nan)),
        3.03e-6,
        3.05e-6,
        (Difference("hysteresis", 3.05e-6, 3.03e-6), Difference("computation delay", 3.05e-6, 2.0e-6)),
    )
    sines = tuple(
        Sine(design.name, variant, freq_hz, (2.0 + i) * 1e-6, (7.13 + i + freq_hz / 10) * 1e-6)
        for variant in ("given", "comparison")
        for i, design in enumerate(made)
        for freq_hz in (1.0, 25.0)
    )
    disturbed = 80e-12 / (1.0 + freq**2)
    bound = 0.97 * min(v.theory.radial_rms_rad for v in verified)
    return FinePointingStudy(scene, verified, verified[1], budget, sines, freq, disturbed, 0.997, bound)


def verified_of(scene, design, i, freq):
    """Made-up residuals: 4.x, 5.x and 6.x µrad at 99.7 %, the second controller's the smallest."""
    closed = close(scene.loop, design.controller)
    theory = stationary(closed)
    simulated = {}
    for place, variant in enumerate(VARIANTS):
        rms = (
            theory.radial_rms_rad * (1.0 + 0.01 * i)
            if variant == "no hysteresis"
            else (2.11 + i / 7 + place / 9) * 1e-6
        )
        quantile = ((5.17, 4.23, 6.41)[i] + place / 20) * 1e-6
        counts = np.diff(-(0.003 ** ((bin_edges_rad() / quantile) ** 2)))  # a Rayleigh distribution with this quantile
        simulated[variant] = Residual(
            rms,
            0.012e-6,
            (rms / 1.4, rms / 1.5),
            (1e-9, -2e-9),
            np.round(1e9 * counts).astype(np.int64),
            quantile,
            quantile + 2.22e-6,
            {},
        )
    predicted = np.full((freq.size, 2), np.nan)
    predicted[1:-1] = residual_spectrum(closed, freq[1:-1])
    return Verified(design, theory, simulated, np.nan_to_num(1.1 * predicted, nan=1e-18), predicted)


def with_fine(plain, fine):
    """The study with this fine-pointing loop in it, and its requirements."""
    found = performance.performance_of_loops(
        plain.links.data, plain.file.mission.conventions.residual, plain.runs, fine
    )
    case = study.best_case(found, fine)
    judged, papers_loop = study.judged(plain.links, plain.requirements[-2:], fine, case)
    return replace(plain, fine_pointing=fine, performance=found, requirements=judged, papers_loop=papers_loop)


def changed(fine, name, **to):
    """The study with fields of one controller's record replaced, the best among them."""
    verified = tuple(replace(v, **to) if v.design.name == name else v for v in fine.verified)
    best = next(v for v in verified if v.design.name == fine.best.design.name)
    return replace(fine, verified=verified, best=best)


def with_residual(fine, name, variant="given", **to):
    """The study with numbers of one residual replaced."""
    simulated = next(v for v in fine.verified if v.design.name == name).simulated
    return changed(fine, name, simulated={**simulated, variant: replace(simulated[variant], **to)})


@pytest.fixture(scope="module")
def written(plain, fine, tmp_path_factory):
    """The report with the figures of the loop and of its tails alone, and one trace."""
    target = tmp_path_factory.mktemp("report") / "study"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(arrays, "study_netcdf", lambda of: study_netcdf(replace(of, runs=of.runs[:1])))
        for module, name in (
            (paper_figures, "paper_figures"),
            (bench, "bench_figures"),
            (link_figures, "link_figures"),
            (day_figures, "day_figures"),
        ):
            patch.setattr(module, name, lambda *args: ())
        report.write(with_fine(plain, fine), target)
    return target


def render(of, drawn=()):
    """The page without its other figures, which take most of the time."""
    with tempfile.TemporaryDirectory() as nothing:
        return report_page.study_page(of, StudyFigures(fine=tuple(drawn)), manifest_of(of, summary(of), Path(nothing)))


def results_of(of, folder, group=None):
    """What results.nc holds, or one group of it, with one trace."""
    (folder / "results.nc").write_bytes(study_netcdf(replace(of, runs=of.runs[:1])))
    return xr.open_datatree(folder / "results.nc", engine="h5netcdf", group=group)


class Tables(HTMLParser):
    """The tables of a page, rows of cells of text, by the heading above them; and all its text."""

    def __init__(self):
        super().__init__()
        self.found, self.text, self.heading, self.inside = {}, [], "", None

    def handle_starttag(self, tag, attrs):
        self.inside = tag if tag in (*HEADINGS, "td", "th", "svg", "script") else self.inside
        if tag in HEADINGS:
            self.heading = ""
        if tag == "tr":
            self.found.setdefault(self.heading, []).append([])
        if tag in ("td", "th"):
            self.found[self.heading][-1].append("")

    def handle_endtag(self, tag):
        self.inside = None if tag == self.inside else self.inside

    def handle_data(self, data):
        if self.inside in HEADINGS:
            self.heading += data
        elif self.inside in ("td", "th"):
            self.found[self.heading][-1][-1] += " ".join(data.split()) + " "
        if self.inside not in ("svg", "script"):
            self.text.append(data)


def read(page):
    tables = Tables()
    tables.feed(page)
    rows = {heading: [[cell.strip() for cell in row] for row in several] for heading, several in tables.found.items()}
    return rows, " ".join(" ".join(tables.text).split())


@pytest.fixture(scope="module")
def page(written):
    return read((written / "report.html").read_text(encoding="utf-8"))


def row(page, heading, name):
    (found,) = [cells for cells in page[0][heading] if cells[0] == name]
    return found


def micro(value_rad):
    """Three digits of a number from 1 to 100."""
    value = 1e6 * value_rad
    assert 1.0 <= value < 100.0
    return f"{value:.2f}" if value < 9.995 else f"{value:.1f}"


# ------------------------------------------------------------------------------------------------ the page


@pytest.mark.promise("readme-11", "report-6")
@pytest.mark.promise("pointing-1", "pointing-2", "pointing-6")
def test_each_controller_stands_with_what_it_leaves_on_each_mirror(page, fine):
    for v in fine.verified:
        cells = row(page, "What each controller leaves", v.design.name)
        assert cells[1] == micro(v.theory.radial_rms_rad)
        for place, variant in enumerate(VARIANTS):
            r = v.simulated[variant]
            wanted = [f"{1e6 * r.rms_rad:.2f} ± 0.01", micro(r.quantile_rad) + " PASS", micro(r.largest_rad)]
            assert cells[2 + 3 * place : 5 + 3 * place] == wanted
    assert "No controller met a limit" in page[1]


@pytest.mark.promise("report-6")
def test_margins_and_parameters_are_the_designs(page, fine):
    for v in fine.verified:
        m = v.design.tuned.margins
        cells = row(page, "What each controller was tuned to, and its margins", v.design.name)
        low, high = (f"{name} {v.design.tuned.values[name]:g} Hz" for name in ("integral frequency", "zero"))
        assert cells[1] == f"{low}, {high}" + ("; inverse in series" if v.design.name == SECOND else "")
        assert cells[2:9] == [
            f"{m.modulus:.2f}",
            f"{20 * math.log10(m.gain_up):.1f}",
            f"{math.degrees(m.phase_rad):.0f}",
            f"{m.delay_s * 1e6:.0f}",
            f"{m.disk:.2f}",
            f"{m.bandwidth_hz:.3g}",
            f"{m.crossover_hz:.3g}",
        ]
        assert cells[9] == "nothing"


def test_the_crossover_is_explained_where_a_design_has_one(fine):
    v = fine.verified[0]
    one, several = v.design.loop_margins, replace(v.design.loop_margins, delay_s=math.nan, crossover_hz=math.nan)
    for margins, has_one in ((one, True), (replace(one, crossover_hz=math.nan), True), (several, False)):
        cells = section.design_cells("as it is", margins, ())
        _, table, below = section.designs([(v.design.name, *cells)], "")
        assert ("crossover (Hz)" in table.headings) is ("delay (\u00b5s)" in table.headings) is has_one
        assert len(table.rows[0]) == len(table.headings) and all(table.rows[0])  # "none" where there is none
        assert ("Crossover: highest" in below.text) is has_one
        assert below.text.startswith("Bandwidth: lowest frequency at which")


def test_controllers_stand_against_disturbances_and_the_open_loop(page, fine):
    heading = "Controllers against disturbances"
    assert page[0][heading][0] == [
        "Controller",
        "vibration (OLYMPUS)",
        "body pointing",
        "optical sensor noise",
        "gauge noise",
        "all",
    ]
    assert row(page, heading, "before the loop")[1:3] == ["15.9", "141"]  # sqrt(80 pi) radial, sqrt(2) 100 µrad
    for v in fine.verified:
        cells = row(page, heading, v.design.name)
        assert cells[1] == micro(math.sqrt(np.sum(v.theory.error_by_source["OLYMPUS"])))
        assert cells[5] == micro(v.theory.radial_rms_rad)


@pytest.mark.promise("readme-11", "report-6")
@pytest.mark.promise("pointing-2")
def test_the_error_budget_adds_up_on_the_page(page):
    heading = f"Error budget of {SECOND}"
    assert row(page, heading, "vibration (OLYMPUS)")[1:] == ["3.00", "3.10", "98.3 %"]
    assert row(page, heading, "body pointing")[1:] == ["0.400", "0.410", "1.7 %"]
    assert row(page, heading, "quantisation")[1:] == ["0", "", "0 %"]
    both, expected = (math.hypot(*pair) for pair in ((3.0, 0.4), (3.1, 0.41)))
    assert row(page, heading, "Root sum square of the parts")[1:3] == [f"{both:.2f}", f"{expected:.2f}"]
    assert row(page, heading, "All together, the mission's mirror")[1] == "3.05"
    added = math.sqrt(3.05**2 - 3.03**2)
    assert row(page, heading, "hysteresis")[1:] == ["3.05", "3.03", f"{added:.3f}"]
    assert "the loop counts as linear" in page[1]


@pytest.mark.promise("readme-11", "report-6")
def test_the_stroke_stands_with_and_without_point_ahead(page, fine):
    axes = (*fine.scene.stroke, *fine.scene.stroke_without_point_ahead)
    assert page[0][STROKE][0][1:] == ["Point-ahead on the mirror (this mission)", "Point-ahead elsewhere"]
    assert row(page, STROKE, "Point-ahead")[1:] == ["71.0", "0", "0", "0"]
    pairs = [f"{1e6 * axis.needed_rad:.0f} / {1e6 * axis.needed_rss_rad:.0f}" for axis in axes]
    assert row(page, STROKE, "Needed at the mirror, optical angle")[1:] == pairs
    assert row(page, STROKE, "Available there: half of the usable travel")[1:] == ["534"] * 4
    assert row(page, STROKE, "Fits")[1:] == ["no / yes"] * 4
    assert 'travel of 2.5 mrad would "fully cover"' in page[1]
    assert "is 1.25 mrad to either side" in page[1] and "the travel covers both" in page[1]
    assert "reaches 43 % of the travel, 534 µrad" in page[1]
    assert "the claim holds for the travel, and not for the drive" in page[1]


@pytest.mark.promise("report-6")
def test_sines_are_held_against_the_requirement(page, fine):
    heading = "The paper's sines under vibration and noise"
    assert page[0][heading][1] == ["Controller", "1 Hz", "25 Hz", "1 Hz", "25 Hz"]
    for v in fine.verified:
        here = [s for s in fine.sines if s.controller == v.design.name]
        marks = ["PASS" if s.quantile_rad <= 10e-6 else "FAIL" for s in here]
        shown = [
            cell.replace(" ‡", "") for cell in row(page, heading, v.design.name)[1:]
        ]  # what its sign says is elsewhere
        assert shown == [
            f"{micro(s.rms_rad)} / {micro(s.quantile_rad)} {mark}" for s, mark in zip(here, marks, strict=True)
        ]
    first = fine.verified[0].design.name
    assert f"is met at 1 Hz by all controllers; at 25 Hz by {first}." in page[1]


@pytest.mark.promise("choose-6")
@pytest.mark.promise("readme-11")
@pytest.mark.promise("sampled-loop-6")
def test_the_section_opens_with_the_verdict_and_its_distance_from_theory(page, fine):
    text, best, baseline = page[1], fine.best, fine.verified[0]
    r, reference = best.simulated["given"], baseline.simulated["given"]
    assert f"{SECOND} is the best of 3 controllers" in text
    assert f"stays within {micro(r.quantile_rad)} µrad for 99.7 % of the time" in text
    assert "The 10 µrad required are met" in text
    assert "Vibration (OLYMPUS) makes up most of it: 3.00 µrad of 3.05 µrad rms" in text
    others = [micro(best.simulated[v].quantile_rad) for v in VARIANTS[1:]]
    assert f"leaves {others[0]} µrad on the comparison model and {others[1]} µrad without hysteresis" in text
    worse = r.rms_rad / reference.rms_rad - 1.0
    assert f"the rms of {SECOND} is {100 * worse:.2g} % higher" in text
    assert f"no linear controller comes below {micro(fine.optimum_rad)} µrad rms" in text
    left = 1.0 - fine.optimum_rad / baseline.theory.radial_rms_rad
    assert f"at most {100 * left:.2g} % are to be gained over it" in text
    settled = "The question of a better linear controller is settled: at most 3 %"
    assert f"So no linear controller can be 20 % better than the baseline. {settled}" in text


@pytest.mark.promise("report-7")
def test_a_study_without_the_loop_has_no_section(plain, tmp_path):
    drawn = fine_pointing_figures(plain)
    text = render(plain, drawn)
    assert HEADING not in text and "Monte Carlo tails" not in text and "Turbulence; " not in text
    assert "Vibration, sensor noise and turbulence" in text
    assert drawn == ()
    assert report.summary(plain)["fine_pointing"] is None
    assert "ine pointing" not in report.verdict_text(plain)
    assert not [w for w in study_words.warnings(plain) if "fine pointing" in w]
    with results_of(plain, tmp_path) as tree:
        assert "fine_pointing" not in tree.children and "tracking" in tree.children


@pytest.mark.promise("readme-7", "report-6")
def test_a_study_with_the_loop_does_not_say_that_it_leaves_out_vibration(page):
    assert HEADING in page[1]
    assert "Vibration, sensor noise and turbulence" not in page[1]
    assert "Turbulence; light time in the times of contacts" in page[1]


# ------------------------------------------------------------------------------------------------ words


@pytest.mark.promise("report-6", "report-7")
def test_the_verdict_is_that_of_the_missions_own_loop(plain, fine):
    whole = with_fine(plain, fine)
    missed = [r.subject for r in whole.requirements if not r.met]
    assert missed == ["stroke"] and whole.closes
    assert [r.met for r in whole.papers_loop] == [False, False] == [r.met for r in plain.requirements[-2:]]
    text = report.verdict_text(whole, 400, verbose=True)
    first = "Not every requirement is met: stroke for the worst case (axis x) (\u221289.1 µrad). The margin is +4.8"
    assert text.startswith(first)
    enough = [replace(axis, usable_travel_rad=axis.travel_rad) for axis in fine.scene.stroke]
    roomy = with_fine(plain, replace(fine, scene=replace(fine.scene, stroke=tuple(enough))))
    text = report.verdict_text(roomy, 400)
    assert roomy.met and text.startswith("The link closes, with a margin of +4.8")
    assert "and every requirement is met, 3 of 6 by the choice of an input" in text.splitlines()[0]
    said = report.verdict_text(plain, 400, verbose=True)
    assert said.startswith("Not every requirement is met: residual pointing error (")
    assert "closes" not in said.splitlines()[0]
    brief = study_words.short(whole)
    assert len(brief) == 5 and all(sentence.endswith(".") for sentence in brief)
    assert brief[-1].startswith("For comparison alone: the paper's loop (PID + inverse, sine of 25 Hz) would miss res")
    assert len(study_words.short(plain)) == 4 and "For comparison alone" not in said
    added = [line for line in study_words.explanation(whole) if line not in study_words.explanation(plain)]
    assert added.pop(0) == "What limits it: Body pointing."
    assert added[0].startswith(f"{HEADING}: {SECOND} leaves 4.23 µrad radial at 99.7 %")
    assert "10 µrad is allowed" in added[0]
    assert added[1] == words.tracked(fine, 10e-6)
    assert added[1].startswith("While a sine of the paper is tracked on the mission's mirror, the requirement is met")
    del added[1]
    assert "better (rms) than the best PI of the gain grid" in added[1]
    assert "axis x needs 623 µrad to either side and has 534 µrad" in added[2]
    assert len(added) == 3
    fine_row, margin_row = (" ".join(map(str, cells)) for cells in requirement_table(whole.requirements).rows[-2:])
    assert fine_row == f"fine pointing at 99.7 % ({SECOND}) 10 µrad 4.23 µrad +5.77 µrad PASS"
    assert margin_row.startswith(f"link margin for 99.7 % of the time ({SECOND}) 3.00 dB 4.8")


@pytest.mark.promise("report-6")
def test_the_tail_stands_by_itself_with_its_intervals(page, fine, written):
    heading = next(each for each in page[0] if each.endswith("Monte Carlo tails"))
    head, *rows = page[0][heading]
    assert head[1:8] == ["50 %", "90 %", "99 %", "99.7 %", "99.9 %", "99.99 %", "99.999 %"]
    assert [cells[0] for cells in rows] == [
        f"{SECOND}, mission's mirror",
        f"{SECOND}, comparison model",
        f"{SECOND}, no hysteresis",
        f"{controller_study.BASELINE}, mission's mirror",
    ]
    assert re.fullmatch(r"4\.23 4\.\d+ to 4\.\d+", rows[0][4])
    assert head[9] == "time beyond 10 µrad"
    assert rows[0][9].startswith("none seen, at most ")
    with (written / "figures" / "monte-carlo-tail.csv").open(newline="", encoding="utf-8") as file:
        heading, *rows = csv.reader(file)
    assert heading[0] == "radial error, mission's mirror (rad)"
    gaussian = heading.index("Rayleigh of the same rms, mission's mirror")
    rms_rad = fine.best.simulated["given"].rms_rad  # of a Rayleigh distribution: exp(-1) lies beyond it
    points = [(float(row[0]), float(row[gaussian])) for row in rows if row[gaussian] and float(row[0]) > 0.0]
    assert len(points) > 20
    for radius_rad, share in points:
        assert share == pytest.approx(math.exp(-((radius_rad / rms_rad) ** 2)), rel=1e-6)


@pytest.mark.promise("report-6")
@pytest.mark.promise("sampled-loop-17")
def test_the_margin_of_the_verdict_follows_from_the_budget_by_its_pointing_loss(plain, fine):
    whole = with_fine(plain, fine)
    (said,) = report_page._judged(whole)
    margin_db, judged_db, budgeted_db = (float(each.replace("\u2212", "-")) for each in re.findall(r"(\S+) dB", said))
    assert margin_db == pytest.approx(whole.static.margin_db + budgeted_db - judged_db, abs=0.02)
    assert f"which {SECOND} does not exceed for 99.7 % of the time" in said and margin_db == round(whole.margin_db, 2)
    assert report_page._judged(plain) == []
    assert {*study_words.terms(whole)} - {*study_words.terms(plain)} == {"Stroke", "OLYMPUS", "PI", "LQG"}


@pytest.mark.promise("report-8")
def test_fine_requirements_stand_with_their_dominant_part(plain, fine):
    def causes(study, found):
        return [row[5] for row in requirement_views.judged_table(study, found).rows]

    whole = with_fine(plain, fine)
    rows = causes(whole, whole.requirements)
    assert rows[4] == "Vibration (OLYMPUS): 3 µrad of 3.05 µrad rms with hysteresis, 97 % of the sum of squares"
    lost = whole.performance.case(performance.FINE, SECOND, "given").outage_loss_db
    top = whole.tornado.swings[0]
    assert rows[5] == (
        f"Vibration (OLYMPUS), pointing loss {lost:.2f} dB at the outage; the margin moves most with {top.key}: "
        f"{top.swing_db:.2f} dB for ±10 %"
    )
    swing = replace(top, key="jitter.rms", margin_low_db=0.0, margin_high_db=1.5)
    moved = replace(whole, tornado=replace(whole.tornado, swings=(swing,)))
    said = causes(moved, moved.requirements)[5]
    assert said.endswith("with jitter.rms: 1.50 dB for ±10 %")
    assert "moves most" not in causes(whole, whole.papers_loop)[-1]


def test_a_missed_requirement_is_said_everywhere(plain, fine, mission):
    missed = with_residual(fine, SECOND, quantile_rad=11.7e-6, largest_rad=13.9e-6)
    assert "The 10 µrad required are missed." in words.result(missed, REQUIRED_RAD)[0]
    assert row(read(render(with_fine(plain, missed))), "What each controller leaves", SECOND)[3] == "11.7 FAIL"
    assert report.summary(with_fine(plain, missed))["fine_pointing"]["met"] is False
    other = with_residual(fine, THIRD, quantile_rad=11.7e-6)
    assert f"The requirement is missed by {THIRD}." in words.result(other, REQUIRED_RAD)
    baseline = fine.verified[0].design.name
    assert f"The requirement is missed by {baseline}." in words.result(
        with_residual(fine, baseline, quantile_rad=11.7e-6), REQUIRED_RAD
    )
    on_comparison = with_residual(fine, SECOND, "comparison", quantile_rad=11.7e-6)
    assert "11.7 µrad on the comparison model (missed)" in " ".join(words.result(on_comparison, REQUIRED_RAD))


def test_a_distant_bound_leaves_the_question_open_and_a_bound_above_theory_is_none(fine, mission):
    lowest = min(v.theory.radial_rms_rad for v in fine.verified)
    near, far, wrong = (replace(fine, optimum_rad=share * lowest) for share in (0.99, 0.6, 1.1))
    assert "settled" in " ".join(words.theory(near))
    assert "settled" not in " ".join(words.theory(far)) and "does not allow" not in " ".join(words.theory(far))
    assert words.theory(wrong)[0].startswith("No bound can be given")
    assert len(words.short(wrong, REQUIRED_RAD)) == len(words.short(near, REQUIRED_RAD)) - 1
    assert any("so it is none" in w for w in warned(wrong, mission))
    assert not any("so it is none" in w for w in warned(near, mission))


@pytest.mark.promise("report-8")
def test_the_missions_own_stroke_counts(fine, mission):
    table = mission.fine_pointing
    reference = table.reference.model_copy(update={"point_ahead_on_mirror": False})
    other = table.model_copy(update={"reference": reference})
    elsewhere = replace(fine, scene=replace(fine.scene, table=other))
    assert fine.scene.own_stroke is fine.scene.stroke
    assert elsewhere.scene.own_stroke is fine.scene.stroke_without_point_ahead
    (lines,) = section.stroke_view(elsewhere).views
    assert [*lines.blocks[0].groups] == [
        ("", 1),
        ("Point-ahead on the mirror", 2),
        ("Point-ahead elsewhere (this mission)", 2),
    ]
    assert any("needs 552 µrad to either side" in line for line in words.short(elsewhere, REQUIRED_RAD))


def test_the_body_error_that_is_advised_uses_up_the_stroke_of_a_mirror_that_turns_less(plain, fine):
    """The mirror turns by a quarter of the line of sight and has a margin: 8 urad of it are 32 urad of the body."""
    shift = replace(fine.scene.stroke[0].lines[0], name="Body pointing", value=200e-6)
    other = replace(shift, name="Point-ahead", value=100e-6)
    few = {"lines": (shift, other), "mirror_per_line_of_sight": 0.25, "usable_travel_rad": 2.0 * (75e-6 + 8e-6)}
    axes = tuple(replace(axis, **few) for axis in fine.scene.stroke)
    whole = with_fine(plain, replace(fine, scene=replace(fine.scene, stroke=axes)))
    (judged,) = (r for r in whole.requirements if r.subject == "stroke")
    body_rad = whole.file.mission.fine_pointing.body.error_rad
    said = requirement_views.advice(whole, judged)
    assert said.endswith(f"may be {quantities.quantity(body_rad * 232 / 200, 'rad')} at most") and "body.error" in said


def test_two_sets_of_hardware_are_told_apart(fine, mission):
    (said,) = [w for w in warned(fine, mission) if "one does not stand for the other" in w]
    assert said.startswith("fine pointing: judged at 5 kHz, 200 µs of delay, an amplifier of 1 kHz; ")
    assert "; the paper's loop runs at 50 kHz, 20 µs of delay, an amplifier of 5 kHz: one" in said
    f = mission.fine_pointing
    same = {"rate_hz": f.rate_hz, "delay_s": f.delay_s}
    amplifier = mission.amplifier.model_copy(update={"bandwidth_hz": f.amplifier_bandwidth_hz})
    paper = mission.control.model_copy(update=same)
    assert not any("one does not stand" in w for several in words.warnings(fine, paper, amplifier) for w in several)


def test_a_stroke_that_fits_is_said_to_fit(fine, mission):
    roomy = [replace(axis, usable_travel_rad=axis.travel_rad) for axis in fine.scene.stroke]
    scene = replace(fine.scene, stroke=tuple(roomy), stroke_without_point_ahead=tuple(roomy))
    text = " ".join(words.stroke(replace(fine, scene=scene)))
    assert "the worst case fits, with 627 µrad to spare on axis x" in text
    assert "the drive that the mirror was identified with" not in text and "reaches" not in text
    assert not any("stroke" in w for w in warned(replace(fine, scene=scene), mission))
    assert len(words.short(replace(fine, scene=scene), REQUIRED_RAD)) == 3


@pytest.mark.parametrize(
    ("value_rad", "text"),
    [
        (1.866e-6, "1.87"),
        (0.8739e-6, "0.874"),
        (0.0612e-6, "0.061"),
        (0.7e-9, "< 0.001"),
        (0.0, "0"),
        (71e-6, "71.0"),
        (623.06e-6, "623"),
        (99.96e-6, "100"),
        (-14.04e-6, "\u221214.0"),
        (math.nan, ""),
    ],
)
def test_angles_have_three_digits_and_at_most_three_decimals(value_rad, text):
    assert quantities.micro(value_rad) == text


@pytest.mark.parametrize(
    ("share", "text"), [(0.0196, "2 %"), (0.2074, "21 %"), (1.0, "100 %"), (3e-7, "< 0.001 %"), (0.0, "0 %")]
)
def test_shares_have_two_digits(share, text):
    assert words.percent(share) == text


def test_an_interval_sets_the_decimals_and_none_is_left_out(fine):
    r = fine.best.simulated["given"]
    assert section.with_interval(replace(r, rms_rad=1.8664e-6, rms_interval_rad=0.0059e-6)) == "1.866 ± 0.006"
    assert section.with_interval(replace(r, rms_rad=1.8664e-6, rms_interval_rad=0.21e-6)) == "1.9 ± 0.2"
    assert section.with_interval(replace(r, rms_rad=1.8664e-6, rms_interval_rad=math.nan)) == "1.87"


# ------------------------------------------------------------------------------------------------ warnings

LIMITS = {
    "saturated samples": 0.003,
    "slew-limited steps": 0.02,
    "steps beyond the identified rate": 0.001,
    "inverse beyond the identified rate": 0.004,
    "steps outside the identified drive range": 0.25,
    "samples without the spot": 1e-6,
}


@pytest.mark.promise("pointing-23")
@pytest.mark.parametrize("limit", LIMITS)
def test_a_limit_that_a_controller_met_is_a_warning_and_on_the_page(fine, mission, limit):
    assert set(LIMITS) == set(COUNTERS)
    met = with_residual(fine, THIRD, "comparison", shares={limit: LIMITS[limit]})
    percent = "< 0.001 %" if LIMITS[limit] == 1e-6 else f"{100 * LIMITS[limit]:g} %"
    assert f"fine pointing: {THIRD} on the comparison model: {percent} {limit}" in warned(met, mission)
    assert not any(limit in w for w in warned(fine, mission))
    assert section.limits(met) == [f"{THIRD}, comparison model: {percent} {limit}"]


@pytest.mark.promise("report-6")
def test_the_chain_marks_the_mirror_by_its_stroke(plain, fine):
    roomy = [replace(axis, usable_travel_rad=axis.travel_rad) for axis in fine.scene.stroke]
    enough = replace(fine, scene=replace(fine.scene, stroke=tuple(roomy)))

    def box(of):
        (found,) = (stage for stage in chain.stages(of) if stage.name == "Mirror")
        return found.mark, *found.lines[-2:]

    assert box(with_fine(plain, fine)) == ("FAIL", "stroke (x): 623 µrad needed,", "534 µrad available")
    available = f"{roomy[0].travel_rad / 2 * 1e6:.0f} µrad available"
    assert box(with_fine(plain, enough)) == ("derived", "stroke (x): 623 µrad needed,", available)
    assert box(plain)[0] == ""  # nothing says what it has to follow
    residual = next(stage for stage in chain.stages(with_fine(plain, enough)) if stage.name == "Residual")
    assert residual.mark == "PASS"  # of the fine loop, which is judged; the sines are judged by themselves
    assert residual.lines == ("4.23 µrad at 99.7 %, vibration", "(12.1 µrad peak, 25 Hz sine)", "allowed 10 µrad")
    words = "at the mirror, whether its stroke covers the worst case"
    assert (words in render(with_fine(plain, fine)), words in render(plain)) == (True, False)


@pytest.mark.promise("report-8")
def test_a_stroke_that_does_not_fit_is_a_warning_for_each_axis(fine, mission):
    x = replace(fine.scene.stroke[0], name="actuator 1")
    tripod = replace(fine, scene=replace(fine.scene, stroke=(x, x, x)))
    assert "worst case on actuator 1: 623 µrad" in warned(tripod, mission)[0]
    found = [w for w in warned(fine, mission) if "stroke" in w]
    assert found[0].startswith("fine pointing: the stroke does not cover the worst case on axis x: 623 µrad needed")
    assert len(found) == 2


def test_warnings_reach_the_page_and_the_summary(page, plain, fine, mission):
    found = warned(fine, mission)
    assert found == [w for w in report.summary(with_fine(plain, fine))["warnings"] if w.startswith("fine pointing: ")]
    assert all(w in page[1] for w in found)


def test_a_design_pressed_against_a_bound_is_a_warning(fine, mission):
    assert not any("up to a bound" in w for w in warned(fine, mission))
    design = fine.verified[2].design
    tuned = replace(design.tuned, bound_by=(MARGIN, "zero at its most"))
    bound = changed(fine, THIRD, design=replace(design, tuned=tuned))
    found = warned(bound, mission)
    less = "beyond it less error may be left"
    assert f"fine pointing: tuned up to a bound, the modulus margin asked for: {THIRD}; {less}" in found
    assert f"fine pointing: tuned up to a bound, zero at its most: {THIRD}; {less}" in found


def test_a_budget_that_is_not_linear_is_a_warning_and_says_where(fine, mission):
    assert not any("not linear" in w for w in warned(fine, mission))
    differences = (Difference("hysteresis", 4.0e-6, 3.03e-6), Difference("limits", 4.0e-6, 4.0e-6))
    bent = replace(fine, budget=replace(fine.budget, full_rad=4.0e-6, differences=differences))
    (found,) = [w for w in warned(bent, mission) if "not linear" in w]
    assert "its parts combine to 3.03 µrad, the whole is 4.00 µrad rms" in found
    sentence = section.budget_sentences(bent)[-1]
    assert "leaves 32 % more than the parts combine to" in sentence
    assert sentence.endswith(f"hysteresis adds {math.sqrt(4.0**2 - 3.03**2):.2f} µrad.")


def test_theory_that_the_simulation_contradicts_is_a_warning(fine, mission):
    assert not any("in theory" in w for w in warned(fine, mission))
    linear = fine.verified[2].theory.radial_rms_rad
    off = with_residual(fine, THIRD, "no hysteresis", rms_rad=1.2 * linear)
    assert any(f"{THIRD} leaves {micro(1.2 * linear)} µrad rms without hysteresis" in w for w in warned(off, mission))


# ------------------------------------------------------------------------------------------------ data and files


def test_the_summary_survives_json_and_holds_the_record(plain, fine):
    data = report.summary(with_fine(plain, fine))["fine_pointing"]
    assert json.loads(json.dumps(data, allow_nan=False)) == data
    assert (data["best"], data["baseline"], data["quantile"]) == (SECOND, controller_study.BASELINE, 0.997)
    for v, entry in zip(fine.verified, data["controllers"], strict=True):
        assert entry["name"] == v.design.name
        assert entry["theory_rms_rad"] == v.theory.radial_rms_rad
        assert entry["parameters"][0] == {
            "name": "integral frequency",
            "unit": "Hz",
            "value": v.design.tuned.values["integral frequency"],
        }
        for variant, r in v.simulated.items():
            assert entry["simulated"][variant]["quantile_rad"] == r.quantile_rad
            assert entry["simulated"][variant]["axis_rms_rad"] == list(r.axis_rms_rad)
        assert entry["margins"]["phase_rad"] == v.design.tuned.margins.phase_rad
    assert data["error_budget"]["parts"][2] == {"name": "quantisation", "rms_rad": 0.0, "theory_rms_rad": None}
    x = data["stroke"]["without_point_ahead"][0]
    assert x["needed_rad"] == pytest.approx(552e-6, abs=0.1e-6) and x["fits"] is False
    assert len(data["sines"]) == 12 and data["sines"][0]["rms_rad"] == fine.sines[0].rms_rad


def test_every_number_of_the_summary_has_its_unit_in_its_key(plain, fine):
    without = {"quantile", "modulus", "disk", "mirror_per_line_of_sight", "value"}
    units = ("_rad", "_hz", "_db", "_s")

    def check(key, value):
        if isinstance(value, dict):
            inherits = key.endswith(units)
            for name, each in value.items():
                check(key if inherits else name, each)
        elif isinstance(value, list):
            for each in value:
                check(key, each)
        elif isinstance(value, float):
            shares = key.startswith(("largest_magnification", "rms_gained", "linear_at", "baseline_with"))
            assert key.endswith(units) or key in without or shares, key

    check("", report.summary(with_fine(plain, fine))["fine_pointing"])


@pytest.mark.promise("readme-11", "report-13")
def test_results_hold_the_loop_with_units(written, fine):
    with xr.open_datatree(written / "results.nc", engine="h5netcdf", group="fine_pointing") as tree:
        for node in tree.subtree:
            for variable in node.to_dataset(inherit=False).variables.values():
                assert variable.attrs["units"] and variable.attrs["long_name"]
        spectra, residuals = tree["spectra"], tree["residuals"]
        assert spectra["residual"].attrs["units"] == spectra["before"].attrs["units"] == "rad^2/Hz"
        assert_array_equal(spectra["before"].values, fine.disturbed_rad2_hz)
        for v in fine.verified:
            name = v.design.name
            assert_array_equal(spectra["residual"].sel(controller=name).values, v.spectrum_rad2_hz)
            assert_array_equal(spectra["predicted"].sel(controller=name).values, v.predicted_rad2_hz)
            for variant, r in v.simulated.items():
                here = residuals.sel(controller=name, mirror=variant)
                assert (float(here["rms"]), float(here["quantile"])) == (r.rms_rad, r.quantile_rad)
                assert_array_equal(here["axis_rms"].values, r.axis_rms_rad)
            noise = tree["theory"]["rms_by_source"].sel(controller=name, source="optical sensor noise")
            assert_allclose(
                float(noise), math.sqrt(np.sum(v.theory.error_by_source["optical sensor noise"])), rtol=1e-12
            )
        assert float(tree["error_budget"]["full"]) == fine.budget.full_rad
        assert_array_equal(tree["sines"]["quantile"].values, [s.quantile_rad for s in fine.sines])
        assert tree["margins"]["delay_s"].attrs["units"] == "s"


def test_limits_and_a_variant_that_is_missing_reach_results(plain, fine, tmp_path):
    fewer = {"given": replace(fine.verified[2].simulated["given"], shares={"saturated samples": 0.125})}
    whole = with_fine(plain, replace(changed(fine, THIRD, simulated=fewer), sines=()))
    text = render(whole)
    assert row(read(text), "What each controller leaves", THIRD)[5:] == ["", "", ""] * 2
    assert "sines under vibration" not in text
    with results_of(whole, tmp_path, "fine_pointing/residuals") as tree:
        here = tree.sel(controller=THIRD)
        assert float(here["share"].sel(mirror="given", limit="saturated samples")) == 0.125
        assert float(here["share"].sel(mirror="given", limit="slew-limited steps")) == 0.0
        assert math.isnan(float(here["rms"].sel(mirror="comparison")))


@pytest.fixture(scope="module")
def drawn(plain, fine):
    return fine_pointing_figures(with_fine(plain, fine))


def test_each_figure_is_an_svg_with_its_data_and_units(written, drawn, fine):
    names = [f"fine-pointing-{name}" for name in ("spectrum", "errors", "budget", "sensitivity")]
    assert [f.name for f in drawn] == names
    for figure in drawn:
        assert (written / "figures" / f"{figure.name}.svg").read_text(encoding="utf-8") == figure.svg
        with (written / "figures" / f"{figure.name}.csv").open(newline="", encoding="utf-8") as lines:
            header, *rows = list(csv.reader(lines))
        assert header == list(figure.columns)
        kept = [np.array([r[i] for r in rows if r[i]], dtype=float) for i in range(len(header))]
        for column, values in zip(figure.columns.values(), kept, strict=True):
            assert_allclose(values, column, rtol=1e-8)
    spectrum, errors, budget, sensitivity = drawn
    for text in ("µrad²/Hz", "frequency (Hz)", "before the loop", SECOND):
        assert text in spectrum.svg
    assert "required: 10 µrad" in errors.svg and "radial error at 99.7 % of the time (µrad)" in errors.svg
    assert "added by hysteresis" in budget.svg and "radial rms (µrad)" in budget.svg
    assert "1 / modulus margin asked for (0.5)" in sensitivity.svg
    assert errors.columns[f"{SECOND}, mission's mirror (rad)"] == [fine.best.simulated["given"].quantile_rad]


def test_the_sensitivity_drawn_peaks_at_the_inverse_of_the_modulus_margin(drawn, fine):
    sensitivity = drawn[-1]
    for name in (controller_study.BASELINE, THIRD):
        margin = next(v for v in fine.verified if v.design.name == name).design.tuned.margins.modulus
        assert np.max(sensitivity.columns[name]) == pytest.approx(1.0 / margin, rel=2e-3)


@pytest.mark.parametrize("every", [1, 5])
def test_the_sensors_noise_up_to_half_of_its_rate_is_its_variance(fine, every):
    loop = replace(fine.scene.loop, optical=replace(fine.scene.loop.optical, every=every))
    half_rate_hz = 0.5 / (loop.timing.period_s * every)
    variance_rad2 = figures._noise_density(replace(fine, scene=replace(fine.scene, loop=loop))) * half_rate_hz
    assert math.sqrt(variance_rad2) == pytest.approx(loop.optical.noise_rad, rel=1e-12, abs=0.0)


def test_cumulative_rms_of_a_flat_spectrum_grows_with_the_root_of_the_band():
    freq = np.arange(1.0, 101.0)
    assert_allclose(figures.cumulative_rms(freq, np.full(100, 4e-12)), 2e-6 * np.sqrt(freq), rtol=1e-12)


def test_a_part_that_helps_is_drawn_as_taken_off(fine):
    helps = Difference("limits", 3.0e-6, 5.0e-6)
    drawn = figures.error_budget(replace(fine.budget, differences=(helps,)))
    assert drawn.columns["taken off by limits (rad)"] == pytest.approx([4e-6], rel=1e-12)
    assert "added by" not in drawn.svg and "taken off by limits" in drawn.svg


def test_three_different_controllers_are_drawn_the_baseline_first(fine):
    assert [each.name for each in figures.shown(fine)] == [controller_study.BASELINE, SECOND, THIRD]
    assert len({each.colour for each in figures.shown(fine)} | {each.marker for each in figures.shown(fine)}) == 6
    best = replace(fine, best=fine.verified[2])
    assert [each.name for each in figures.shown(best)] == [controller_study.BASELINE, THIRD, SECOND]


def test_a_sensor_slower_than_the_control_has_no_sensitivity_drawn(plain, fine):
    optical = replace(fine.scene.loop.optical, every=2)
    slow = replace(fine, scene=replace(fine.scene, loop=replace(fine.scene.loop, optical=optical)))
    assert [f.name[14:] for f in fine_pointing_figures(with_fine(plain, slow))] == ["spectrum", "errors", "budget"]


# ----------------------------------------------------------------------------------------------- limits, and other ways
def ns(**values):
    return SimpleNamespace(**values)


def left_of(rms_rad, quantile_rad=1e-6, **more):
    return ns(rms_rad=rms_rad, quantile_rad=quantile_rad, shares={}, **more)


def verified(name, theory_rad, given_rad, **others):
    """A controller with what theory and the variants of the mirror leave of it."""
    simulated = {"given": left_of(given_rad)} | {key: left_of(*both) for key, both in others.items()}
    return ns(design=ns(name=name), theory=ns(radial_rms_rad=theory_rad), simulated=simulated)


def loops_of(optimum_rad, *every):
    return ns(optimum_rad=optimum_rad, verified=every, best=every[-1], quantile=0.997)


@pytest.mark.parametrize(("bound_rad", "holds"), [(1.01, True), (1.0101, False), (0.5, True)])
def test_a_bound_holds_up_to_a_hundredth_above_what_a_design_reaches(bound_rad, holds):
    found = words.room(loops_of(bound_rad, verified("PI", 2.0, 4.0), verified("LQG", 1.0, 3.0)))
    assert found.holds is holds
    assert (found.baseline.design.name, found.nearest.design.name) == ("PI", "LQG")
    assert found.at_nearest == pytest.approx(max(0.0, 1.0 - bound_rad))
    assert found.at_baseline == pytest.approx(1.0 - bound_rad / 2.0)
    assert (found.with_hysteresis, found.gained) == (pytest.approx(1.0 - bound_rad / 4.0), pytest.approx(0.25))


@pytest.mark.parametrize(
    ("items", "said"), [([], ""), (["a"], "a"), (["a", "b"], "a and b"), (["a", "b", "c"], "a, b and c")]
)
def test_one_several_and_none_are_listed(items, said):
    assert words.listed(items) == said


def test_what_the_best_controller_leaves_on_other_mirrors_is_held_against_the_requirement():
    alone = loops_of(1e-6, verified("PI", 2e-6, 4e-6))
    assert words._other_variants(alone, 5e-6) == []
    both = {"comparison": (1e-6, 5e-6), "no hysteresis": (1e-6, 5.01e-6)}
    assert words._other_variants(loops_of(1e-6, verified("PI", 2e-6, 4e-6, **both)), 5e-6) == [
        "The same controller leaves 5.00 µrad on the comparison model and 5.01 µrad without hysteresis (missed)."
    ]


def room_of(**changes):
    of = verified("PI", 2e-6, 4e-6)
    given = {"at_baseline": 0.5, "at_nearest": 0.5, "with_hysteresis": 0.5, "gained": 0.1, "holds": True}
    return words.Room(of, of, **given | changes)


@pytest.mark.parametrize(
    ("changes", "better", "settled", "hysteresis"),
    [
        ({}, False, False, False),
        ({"at_baseline": 0.2, "with_hysteresis": 0.2}, False, False, False),
        ({"at_baseline": 0.19, "with_hysteresis": 0.19}, True, False, False),
        ({"at_nearest": 0.05}, False, False, False),
        ({"at_nearest": 0.049}, False, True, False),
        ({"with_hysteresis": 0.52}, False, False, True),
        ({"at_baseline": 0.0, "with_hysteresis": 0.01}, True, False, False),
    ],
)
def test_theory_says_what_is_settled_below_its_limits(monkeypatch, changes, better, settled, hysteresis):
    monkeypatch.setattr(words, "room", lambda fine: room_of(**changes))
    said = " ".join(words.theory(loops_of(1e-6, verified("PI", 2e-6, 4e-6))))
    assert ("no linear controller can be 20 % better" in said) is better
    assert ("is settled" in said) is settled
    assert ("On the mission's mirror hysteresis brings the baseline to 4.00 µrad" in said) is hysteresis


def test_hysteresis_that_a_controller_does_not_undo_gains_nothing(monkeypatch):
    monkeypatch.setattr(words, "room", lambda fine: room_of(with_hysteresis=0.9, gained=-0.1))
    assert words.theory(loops_of(1e-6, verified("PI", 2e-6, 4e-6)))[-1].endswith("at most 90 % lower; PI is 0 % lower.")


def test_a_sine_is_tracked_where_its_error_is_the_one_required():
    def sine(controller, freq_hz, quantile_rad, variant="given"):
        return ns(controller=controller, freq_hz=freq_hz, quantile_rad=quantile_rad, variant=variant)

    sines = [sine("PI", 1.0, 5e-6), sine("LQG", 1.0, 1e-6), sine("PI", 2.0, 5.01e-6), sine("LQG", 2.0, 5e-6)]
    sines += [sine("PI", 3.0, 7e-6), sine("LQG", 3.0, 6e-6), sine("LQG", 3.0, 1e-6, "no hysteresis")]
    said = words.tracked(ns(sines=sines), 5e-6)
    assert said == (
        "While a sine of the paper is tracked on the mission's mirror, the requirement is met at 1 Hz by all "
        "controllers; at 2 Hz by LQG; at 3 Hz by none (least: 6.00 µrad, LQG)."
    )
    assert words.tracked(ns(sines=[]), 5e-6) == ""


def stroke_axis(needed_rad, margin_rad=1e-6, fits_rss=True, travel_rad=2e-3, **more):
    given = {"travel_angle": "mechanical", "usable_share": 1.0, "available_rad": 0.5e-3, "label": "axis x"}
    own = {"needed_rad": needed_rad, "margin_rad": margin_rad, "fits": margin_rad >= 0.0, "fits_rss": fits_rss}
    return ns(travel_rad=travel_rad, **given | own | more)


def stroke_words(on_mirror, elsewhere):
    return words.stroke(ns(scene=ns(stroke=on_mirror, stroke_without_point_ahead=elsewhere)))


@pytest.mark.parametrize(
    ("on_mirror_rad", "elsewhere_rad", "covers"),
    [
        ([1e-3], [0.5e-3], "covers both"),
        ([1.01e-3], [1e-3], "covers only the second"),
        ([0.5e-3, 1.01e-3], [0.5e-3, 1e-3], "covers only the second"),
        ([1.01e-3], [0.5e-3, 1.01e-3], "covers neither"),
    ],
)
def test_a_travel_covers_what_is_needed_to_its_last_half(on_mirror_rad, elsewhere_rad, covers):
    said = stroke_words(*([stroke_axis(each) for each in several] for several in (on_mirror_rad, elsewhere_rad)))
    most = [quantities.angle(max(several)) for several in (on_mirror_rad, elsewhere_rad)]
    assert said[0] == (
        "The travel of 2 mrad from stop to stop (mechanical angle) is 1 mrad to either side; the worst case needs "
        f"{most[0]} with the point-ahead on the mirror and {most[1]} with the point-ahead elsewhere: the travel "
        f"{covers}."
    )
    assert len(said) == 3


def test_the_papers_travel_has_its_claim_judged_where_it_covers_and_the_drive_does_not():
    paper = {"travel_rad": words.PAPER_TRAVEL_RAD}
    fits, misses, large = (
        stroke_axis(1e-3, **paper),
        stroke_axis(1e-3, -1e-6, **paper),
        stroke_axis(2e-3, -1e-6, **paper),
    )
    claim = "So the claim holds for the travel, and not for the drive that the mirror was identified with."
    for on_mirror, elsewhere, judged in (
        ((fits,), (fits,), False),
        ((misses,), (fits,), True),
        ((fits,), (fits, misses), True),
        ((large,), (fits,), False),
    ):
        said = stroke_words(on_mirror, elsewhere)
        assert said[0].startswith("The paper says that a travel of 2.5 mrad")
        assert (claim in said) is judged
    assert claim not in stroke_words((stroke_axis(0.5e-3, -1e-6),), (stroke_axis(0.5e-3),))


def test_the_drive_is_told_of_a_mirror_of_one_axis_alone():
    """A mirror of several axes has no single bias."""
    said = stroke_words((stroke_axis(1e-3, usable_share=0.5),), (stroke_axis(1e-3),))
    assert not any("reaches" in each for each in said)


def test_a_worst_case_that_misses_names_the_least_margin_and_what_its_root_sum_square_does():
    fits, misses = stroke_axis(1e-3, 0.0), stroke_axis(1e-3, -2e-6, label="axis y")
    assert words._fit("here", (fits,)) == "Here the worst case fits, with 0 µrad to spare on axis x."
    end = "Here the worst case misses by 2.00 µrad on axis y; the root sum square "
    assert words._fit("here", (fits, misses)) == f"{end}fits."
    assert words._fit("here", (stroke_axis(1e-3, 1e-6, False), misses)) == f"{end}does not fit either."


def test_what_a_mirror_was_recorded_to_counts_from_half_of_the_control_rate():
    def said(delay_s, most_hz):
        scene = ns(mirror=ns(delay_s=delay_s, excited_hz=(1.0, most_hz)), table=ns(rate_hz=5000.0))
        return words.left_out(scene)

    assert said(0.0, 2500.0) == []
    assert said(1e-4, 2500.0) == [
        "the recordings' delay of 100 µs is left out; fine_pointing.delay and fine_pointing.amplifier_bandwidth stand "
        "for the flight's own"
    ]
    assert said(0.0, 2499.0) == [
        "the mirror was recorded up to 2.499 kHz, and half of the control rate is 2.5 kHz: between them the model is a "
        "guess"
    ]


@pytest.mark.parametrize(
    ("straight_rad", "warns"), [(2.19e-6, False), (2.21e-6, True), (1.81e-6, False), (1.79e-6, True)]
)
def test_theory_is_contradicted_by_more_than_a_tenth_either_way(straight_rad, warns):
    both = {"no hysteresis": (straight_rad, 1e-6)}
    fine = loops_of(1e-6, verified("PI", 2e-6, 4e-6, **both))
    fine.budget = ns(linear=True)
    assert len(words._theory_warnings(fine)) == warns


@pytest.mark.parametrize(
    ("half_rad", "said"),
    [(0.0, "1.87"), (math.inf, "1.87"), (math.nan, "1.87"), (0.00001e-6, "1.866 ± 0.001"), (1e-6, "2 ± 1")],
)
def test_an_interval_is_told_where_it_is_known(half_rad, said):
    assert section.with_interval(ns(rms_rad=1.8664e-6, rms_interval_rad=half_rad)) == said


def test_a_value_at_the_requirement_passes():
    assert (section._mark(1e-5, 1e-5), section._mark(1.0001e-5, 1e-5)) == ("PASS", "FAIL")
    sine = ns(controller="PI", variant="given", freq_hz=1.0, rms_rad=1e-6, quantile_rad=1e-5)
    assert section._sine(sine, 1e-5) == section.Cell("1.00 / 10.0", "PASS")
    assert section._sine(None, 1e-5) == ""
    assert plain_data._sine(sine, 1e-5)["met"] is True
    assert plain_data._sine(sine, 0.9999e-5)["met"] is False
    left = ns(rms_rad=1e-6, rms_interval_rad=0.0, axis_rms_rad=(1e-6,), quantile_rad=1e-5, largest_rad=2e-5, shares={})
    assert plain_data._residual(left, 1e-5)["met"] is True
    assert plain_data._residual(left, 0.9999e-5)["met"] is False


@pytest.mark.parametrize(
    ("variance", "total", "said"),
    [(0.0, 1.0, "0 %"), (4e-4, 1.0, "< 0.1 %"), (6e-4, 1.0, "0.1 %"), (1.0, 2.0, "50.0 %"), (0.0, 0.0, "0 %")],
)
def test_a_share_of_the_variance_is_told_to_a_tenth_of_a_per_cent(variance, total, said):
    assert section._variance_share(variance, total) == said


def budget(full_rad, *differences, linear=False):
    parts = [ns(name=name, added_rad=added_rad) for name, added_rad in differences]
    return ns(budget=ns(together_rad=1.1e-6, combined_rad=1e-6, full_rad=full_rad, linear=linear, differences=parts))


def test_a_budget_says_where_its_loop_is_not_linear():
    begin = "Without hysteresis the parts combine to what they leave together, to within 10 %."
    end = "than the parts combine to, so it is not linear (10 % is the limit)"
    assert section.budget_sentences(budget(1.05e-6, linear=True)) == [
        begin,
        "With it they still do, to within 5 %: the loop counts as linear.",
    ]
    assert section.budget_sentences(budget(1.5e-6)) == [begin, f"The full loop leaves 50 % more {end}."]
    assert section.budget_sentences(budget(0.5e-6))[1] == f"The full loop leaves 50 % less {end}."
    several = (section.DELAY, 1e-6), ("hysteresis", 0.0151e-6), ("quantisation", 0.015e-6), ("saturation", 1e-6)
    assert section.budget_sentences(budget(1.5e-6, *several))[1] == (
        f"The full loop leaves 50 % more {end}: hysteresis adds 0.015 µrad and saturation adds 1.00 µrad."
    )


@pytest.mark.parametrize(
    ("worst", "rss", "said"),
    [(True, True, "yes / yes"), (False, True, "no / yes"), (False, False, "no / no"), (True, False, "yes / no")],
)
def test_worst_case_and_root_sum_square_fit_each_by_itself(worst, rss, said):
    assert section._yes(worst, rss) == said


def test_a_magnification_without_bound_is_any():
    def told(worst, rss):
        return section._magnification(ns(largest_magnification=worst, largest_magnification_rss=rss))

    assert told(math.inf, math.inf) == "any / any"
    assert told(12.5, math.inf) == "12.50 / any"
    assert told(12.5, 13.0) == "12.50 / 13.00"


def test_a_mirror_that_may_not_be_relied_on_meets_nothing(fine):
    class Unknown:
        """The scene of a mirror whose dynamics are not known."""

        unknown_dynamics = "its dynamics are not known"

        def __getattr__(self, name):
            return getattr(fine.scene, name)

    blind = replace(fine, scene=Unknown())
    for of, met in ((fine, True), (blind, False)):
        assert plain_data.fine_pointing_data(of, REQUIRED_RAD)["met"] is met
    assert words.not_reliable(fine.scene) == []
    assert words.not_reliable(blind.scene) == ["Not to be relied on: its dynamics are not known."]
    assert words.result(blind, REQUIRED_RAD)[0] == words.not_reliable(blind.scene)[0]


def worst_case_of(**changes):
    return ns(**{"corners_left_out": 0, "unstable_draws": 0, "unstable_corners": 0} | changes)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({}, []),
        ({"corners_left_out": 1}, ["1 corner is no mirror and is left out."]),
        ({"corners_left_out": 2}, ["2 corners are no mirrors and are left out."]),
        (
            {"unstable_draws": 1},
            ["The loop is unstable on 1 of the draws and on 0 of the corners: no margin, and an error without bound."],
        ),
        (
            {"unstable_corners": 3},
            ["The loop is unstable on 0 of the draws and on 3 of the corners: no margin, and an error without bound."],
        ),
    ],
)
def test_a_loop_that_is_unstable_somewhere_says_where(changes, said):
    assert worst_case._unstable(worst_case_of(**changes)) == said


@pytest.mark.parametrize(
    ("linear", "full", "agrees", "said"),
    [
        ("settles", "settles", True, "settles, as its largest pole says"),
        ("grows", "grows", True, "does not settle, as its largest pole says"),
        (
            "settles",
            "grows",
            False,
            "settles without hysteresis and limits, and does not settle with them, against what its largest pole says",
        ),
    ],
)
def test_how_the_worst_loop_does_in_time_is_told_once_where_both_do_the_same(linear, full, agrees, said):
    seen = ns(linear=linear, with_hysteresis=full, agrees=agrees, seconds=0.5, offset_rad=1e-6, pole=0.99)
    assert worst_case.in_time(seen) == (
        "Simulated at the smallest margin for 500 ms, from an offset of 1.00 µrad, without disturbances: the loop "
        f"{said} (|z| = 0.990000)."
    )


def test_what_is_not_finite_is_unstable():
    assert (worst_case._error(math.inf), worst_case._error(1e-6)) == ("unstable", "1 µrad")
    assert (worst_case._change(math.inf), worst_case._change(0.05)) == ("unstable", "5 %")
    assert worst_case._change(math.nan) == "unstable"


@pytest.mark.parametrize(
    ("changes", "rows", "spread"),
    [
        ({}, ("10⁻⁶ to 10⁻⁴", "3.00 dB"), "with a block interleaver over 5 ms"),
        ({"interleaving": "none"}, ("10⁻⁶ to 10⁻⁴", "3.00 dB"), "without an interleaver"),
        ({"penalty_db": math.inf}, ("10⁻⁶ to 10⁻⁴", "beyond 20 dB"), "with a block interleaver over 5 ms"),
        ({"high": math.inf}, ("unknown", "3.00 dB"), "with a block interleaver over 5 ms"),
    ],
)
def test_a_coded_link_says_what_is_not_known_of_it(changes, rows, spread):
    given = {"interleaving": "block", "penalty_db": 3.0, "high": 1e-4} | changes
    ratio = ns(value=1e-5, low=1e-6, high=given.pop("high"))
    coded = ns(code="LDPC", on_axis_db=2.0, target=1e-6, span_s=5e-3, ratio=ratio, **given)
    table, points = simulated_windows._coded(coded)
    assert table.rows == [("mean bit error ratio", "10⁻⁵", rows[0]), ("power that pointing costs", rows[1], "")]
    assert points.lines[0].startswith(f"LDPC, BPSK with soft decisions, {spread}, at 2.00 dB more on the axis")


def test_windows_are_held_against_linear_filters_where_both_are_known():
    def error(kind, window_s, rational, before):
        return ns(index=ErrorIndex(kind, window_s), left={"a": 1e-6}, before={"a": before}, rational=rational)

    errors = [error("MPE", 1.0, 2e-6, 1e-6), error("RPE", 2.0, math.nan, 1e-6), error("MPE", 3.0, 2e-6, 0.0)]
    errors.append(error("APE", None, 2e-6, 1e-6))
    text = windows.windows_text(errors, "PI", 120)
    shown = text.split("by linear filters")[1]
    assert "MPE 1 s" in shown and "100 %" in shown
    assert not any(other in shown for other in ("RPE", "3 s", "APE"))


def recorded_axis(name, lines=(), white=True, stationary=True):
    motion = ns(name=name, mean_rad=1e-6, slope_rad_s=2e-6, rest_rad=np.array([3e-6, -3e-6]))
    fit = ns(
        motion=motion,
        disturbance=ns(lines=lines),
        order=4,
        worst_db=-0.5,
        whiteness=ns(white=white, p_value=0.25),
        stationarity=ns(stationary=stationary),
    )
    played = ns(rms_rad=3e-6, mean_rad=1e-7)
    left = ns(played=played, fitted_rms_rad=4e-6, difference=-0.25, simulated_rms_rad=5e-6, noise_rms_rad=6e-6)
    return recorded.RecordedAxis(fit, left)


def test_two_axes_of_a_recording_have_their_radial_error_too():
    one, other = recorded_axis("x"), recorded_axis("y")
    row = ("x", "3.00", "4.00", "\u221225 %", "5.00", "0.100", "6.00")
    alone = recorded._left([one], "PI")
    assert (alone.rows, alone.totals) == ([row], False)
    both = recorded._left([one, other], "PI")
    assert both.rows == [row, ("y", *row[1:]), ("radial", "4.24", "5.66", "\u221225 %", "7.07", "", "8.49")]
    assert both.totals


def test_what_was_recorded_and_fitted_stands_by_axis():
    line = ns(freq_hz=40.0, amplitude_rad=1e-6)
    axes = [recorded_axis("x", [line, line]), recorded_axis("y", white=False), recorded_axis("z", stationary=False)]
    assert [row[4] for row in recorded._motions(axes).rows] == ["40 Hz: 1.00\n40 Hz: 1.00", "none", "none"]
    assert recorded._motions(axes).rows[0][:4] == ("x", "1.00", "2.00", "3.00")
    assert recorded._fits(axes).rows == [
        ("x", "4", "\u22120.50 dB", "yes, p = 0.25", "yes"),
        ("y", "4", "\u22120.50 dB", "no, p = 0.25", "yes"),
        ("z", "4", "\u22120.50 dB", "yes, p = 0.25", "no"),
    ]


@pytest.mark.parametrize("count", [1, 2])
def test_the_data_of_a_recording_have_a_radial_error_where_there_are_two_axes(monkeypatch, count):
    monkeypatch.setattr(recorded, "_axis_data", lambda each: {})
    monkeypatch.setattr(recorded, "sentences", lambda axes, loop: [])
    axis = recorded_axis("x")
    axis.fit.motion.half_rate_hz, axis.fit.motion.duration_s = 500.0, 3.0
    data = recorded.recording_data("a.csv", "0" * 64, [axis] * count, None)
    assert (data["rate_hz"], len(data["axes"])) == (1000.0, count)
    assert ("radial" in data) is (count == 2)


@pytest.mark.parametrize(("noise", "lines"), [(0.0, False), (1e-18, False), (0.0, True)])
def test_a_spectrum_has_the_sensors_noise_and_the_word_on_wheels_where_there_are_any(
    plain, fine, monkeypatch, noise, lines
):
    monkeypatch.setattr(figures, "_noise_density", lambda fine: noise)
    monkeypatch.setattr(figures, "_lines", lambda fine: lines)
    drawn = {figure.name: figure for figure in fine_pointing_figures(with_fine(plain, fine))}["fine-pointing-spectrum"]
    rules = [rule.at for rule in drawn.sheet.panels[0].all_of(Rule) if rule.label == "sensor noise"]
    assert rules == ([pytest.approx(noise * 1e12)] if noise else [])
    assert drawn.caption.endswith("Lines of the reaction wheel are not in the spectrum before the loop.") is lines


def test_a_sensitivity_has_the_margin_that_is_asked_for_where_one_is():
    for table, labels in ((None, [""]), (ns(modulus_margin=0.5), ["", "1 / modulus margin asked for (0.5)"])):
        panel = Panel(0, 0)
        figures._ceiling(panel, ns(fine_pointing=table))
        assert [rule.label for rule in panel.all_of(Rule)] == labels
        assert [rule.at for rule in panel.all_of(Rule)] == [1.0, 2.0][: len(labels)]


def test_of_several_axes_whose_stroke_is_short_the_one_with_the_least_margin_is_told(fine):
    """Its need and its stroke, not those of the first one."""
    first, second = (
        replace(axis, usable_travel_rad=share * axis.usable_travel_rad)
        for axis, share in zip(fine.scene.stroke, (0.5, 0.1), strict=True)
    )
    assert not first.fits
    assert second.margin_rad < first.margin_rad
    said = words.short(replace(fine, scene=replace(fine.scene, stroke=(first, second))), REQUIRED_RAD)[-1]
    need, have = words.angle(second.needed_rad), words.angle(second.available_rad)
    assert said.endswith(f"{second.label} needs {need} to either side and has {have}.")
    assert have != words.angle(first.available_rad)


# --------------------------------------------------------------------------- records unlike each other, held as a whole
def two_indices():
    """A window alone and two of them apart; the numbers of each are unlike those of the other."""
    return ErrorIndex("RPE", 0.25), ErrorIndex("PDE", 0.5, 8.0)


def a_worst_case():
    def change(name, *shares):
        return ns(parameter=name, rms=shares[:2], modulus=shares[2])

    def place(value, alpha, mode):
        return ns(value=value, sigmas={"alpha": alpha, "mode 1": mode})

    return ns(
        extent=ns(draws=40, sigmas=2.5),
        indices=two_indices(),
        controller="LQG",
        corners=8,
        most_sensitive=(change("alpha", 0.01, -0.025, 0.002), change("mode 1", math.inf, 0.5, -0.125)),
        nominal_rad=(1e-6, 2.5e-6),
        drawn_rad=(ns(median=1.25e-6, worse=1.5e-6), ns(median=2.75e-6, worse=3.125e-6)),
        largest_rad=(place(math.inf, 2.5, -2.5), place(4.5e-6, -1.25, 0.5)),
        nominal_modulus=0.5625,
        drawn_modulus=ns(median=0.53125, worse=0.4375),
        smallest_modulus=place(0.3125, 0.75, -0.25),
        corners_left_out=1,
        unstable_draws=3,
        unstable_corners=2,
        verified_in_time=ns(
            linear="settles", with_hysteresis="grows", agrees=False, seconds=0.125, offset_rad=3e-6, pole=0.987654
        ),
    )


def test_a_worst_case_has_each_figure_beside_its_own_index_and_parameter():
    assert worst_case.worst_case_text(a_worst_case(), 110).split("\n") == [
        ("The loop under LQG on 40 mirrors drawn from what is known of its mirror, and on 8 corners of its 2 most"),
        "sensitive parameters at 2.5 standard errors. In theory (linear); errors are radial rms.",
        "",
        "",
        " figure                 as identified   median      95 % of draws   worst",
        " ───────────────────────────────────────────────────────────────────────────",
        " RPE 250 ms             1 µrad          1.25 µrad   1.5 µrad        unstable",
        " PDE 500 ms 8 s apart   2.5 µrad        2.75 µrad   3.125 µrad      4.5 µrad",
        " modulus margin         0.5625          0.5312      0.4375          0.3125",
        "",
        "Most sensitive parameters: change by one",
        "standard error",
        "",
        "                        PDE",
        "             RPE        500 ms      modulus",
        " parameter   250 ms     8 s apart   margin",
        " ──────────────────────────────────────────",
        " alpha       1 %        −2.5 %      0.2 %",
        " mode 1      unstable   50 %        −12 %",
        "",
        "Where each figure is worst, in standard",
        "errors",
        "",
        "                      PDE",
        "             RPE      500 ms      modulus",
        " parameter   250 ms   8 s apart   margin",
        " ────────────────────────────────────────",
        " alpha       +2.5     −1.2        +0.8",
        " mode 1      −2.5     +0.5        −0.2",
        "",
        "1 corner is no mirror and is left out.",
        ("The loop is unstable on 3 of the draws and on 2 of the corners: no margin, and an error without bound."),
        ("Simulated at the smallest margin for 125 ms, from an offset of 3.00 µrad, without disturbances: the loop"),
        (
            "settles without hysteresis and limits, and does not settle with them, against "
            "what its largest pole says (|z|"
        ),
        "= 0.987654).",
    ]


def test_windows_by_two_sources_have_each_their_own_total():
    def error(index, left, before, rational):
        return ns(index=index, left=left, before=before, rational=rational)

    first, second = two_indices()
    errors = [
        error(first, {"OLYMPUS": 3e-6, "noise": 4e-6}, {"OLYMPUS": 6e-6, "noise": 8e-6}, 1.2e-5),
        error(second, {"OLYMPUS": 5e-7, "noise": 12e-7}, {"OLYMPUS": 15e-7, "noise": 8e-7}, 1.6e-6),
    ]
    assert windows.windows_text(errors, "H-infinity", 100, ["A remark."]).split("\n") == [
        ("Radial rms in µrad, in theory: each hysteresis element counts by its slow gain, in a mirror of"),
        "several axes by that about rest.",
        "A remark.",
        "",
        "Left by the loop under H-infinity",
        "",
        "                                PDE",
        "                       RPE      500 ms",
        " source                250 ms   8 s apart",
        " ────────────────────────────────────────",
        " vibration (OLYMPUS)   3.00     0.500",
        " noise                 4.00     1.20",
        " all                   5.00     1.30",
        "",
        "Without the loop",
        "",
        "                                PDE",
        "                       RPE      500 ms",
        " source                250 ms   8 s apart",
        " ────────────────────────────────────────",
        " vibration (OLYMPUS)   6.00     1.50",
        " noise                 8.00     0.800",
        " all                   10.0     1.70",
        "",
        "Without the loop, by linear filters",
        "",
        " index                  exact   rational   off by",
        " ────────────────────────────────────────────────",
        " RPE 250 ms             10.0    12.0       20 %",
        " PDE 500 ms 8 s apart   1.70    1.60       −5.9 %",
    ]


def test_simulated_windows_with_code_words_and_a_coded_link_as_a_whole():
    first, second = two_indices()
    errors = [
        ns(index=first, linear_rad=1e-6, rms_rad=1.5e-6, interval_rad=0.125e-6, axis_rms_rad=np.array([9e-7, 12e-7])),
        ns(index=second, linear_rad=2e-6, rms_rad=2.25e-6, interval_rad=math.inf, axis_rms_rad=np.array([1e-6, 2e-6])),
    ]
    lost = ns(
        code_word_s=64e-6,
        words=5000,
        lost=ns(value=0.0125, low=0.01, high=0.0175),
        time=ns(value=0.00625, low=0.005, high=0.0075),
    )
    coded = ns(
        code="LDPC",
        interleaving="convolutional",
        span_s=0.025,
        penalty_db=1.375,
        on_axis_db=4.5,
        target=2e-9,
        ratio=ns(value=3e-7, low=2e-7, high=5e-7),
    )
    view = simulated_windows.simulated_view(errors, lost, 24, [ErrorIndex("MPE", 90.0), ErrorIndex("RPE", 60.0)], coded)
    assert views_text([view], 110).split("\n") == [
        "Simulated, with hysteresis",
        "",
        "Simulated, with hysteresis",
        "",
        " index                  linear   simulated   99 % interval",
        " ─────────────────────────────────────────────────────────",
        " RPE 250 ms             1.00     1.50        ± 0.125",
        " PDE 500 ms 8 s apart   2.00     2.25        unknown",
        "",
        (
            "- Radial rms in µrad, both at the control samples: linear in theory, simulated on "
            "the mission's mirror. Number"
        ),
        "  of runs: 24; their spread gives the interval.",
        "- Longer than a run behind its settling, and left out: MPE 90 s, RPE 60 s.",
        "",
        "Lost to pointing, simulated",
        "",
        " share of              lost      99 % interval",
        " ───────────────────────────────────────────────",
        " code words of 64 µs   1.25 %    1 % to 1.75 %",
        " time                  0.625 %   0.5 % to 0.75 %",
        "",
        ("- Of 5000 code words those whose mean power is less than the required margin asks for, and the share of the"),
        ("  time with less than that. Where none or all are lost, the interval takes them as independent."),
        "",
        "Coded link, simulated",
        "",
        " of the coded link           value     99 % interval",
        " ──────────────────────────────────────────────────────",
        " mean bit error ratio        3×10⁻⁷    2×10⁻⁷ to 5×10⁻⁷",
        " power that pointing costs   1.38 dB",
        "",
        ("- LDPC, BPSK with soft decisions, with a convolutional interleaver over 25 ms, at 4.50 dB more on the axis"),
        ("  than the code needs at constant power; the cost brings the mean back to 2×10⁻⁹. Power falls with each"),
        "  simulated error as that of a Gaussian beam, and stands still over a control sample.",
    ]
    assert rounded(simulated_windows._indices(errors)) == [
        {
            "index": "RPE",
            "window_s": 0.25,
            "spacing_s": None,
            "linear_rad": 1e-06,
            "simulated_rad": 1.5e-06,
            "interval_rad": 1.25e-07,
            "simulated_by_axis_rad": [9e-07, 1.2e-06],
        },
        {
            "index": "PDE",
            "window_s": 0.5,
            "spacing_s": 8.0,
            "linear_rad": 2e-06,
            "simulated_rad": 2.25e-06,
            "interval_rad": None,
            "simulated_by_axis_rad": [1e-06, 2e-06],
        },
    ]


def a_played_axis(name, k, *, white, stationary, reason, beyond_rad):
    """An axis of a recording, all of whose numbers follow from ``k``."""
    block = {"ratio": 1.5 * k, "usual": 2.5 * k, "ratio_p": 0.1 * k, "growth": 0.3 * k, "growth_p": 0.2 * k}
    fast = {key: value + 10.0 for key, value in block.items()}
    motion = ns(
        name=name,
        mean_rad=1e-6 * k,
        slope_rad_s=2.5e-6 * k,
        rest_rad=np.array([3e-6, -4e-6, 5e-6]) * k,
        duration_s=12.5,
        half_rate_hz=400.0,
    )
    lines = tuple(ns(freq_hz=f * k, amplitude_rad=1e-7 * f * k) for f in (12.0, 37.5))
    fit = ns(
        motion=motion,
        disturbance=ns(lines=lines),
        order=3 + k,
        worst_db=-0.75 * k,
        worst_at_hz=55.0 * k,
        band_limited=k == 1,
        correlation_s=0.125 * k,
        whiteness=ns(white=white, p_value=0.0625 * k, largest=0.03125 * k, lags=20 + k, statistic=7.5 * k),
        stationarity=ns(stationary=stationary, reason="a reason", motion=ns(**block), fast=ns(**fast)),
    )
    played = ns(
        rms_rad=3e-6 * k, mean_rad=1.5e-7 * k, begin_s=0.5, end_s=11.0, most_rms_rad=7e-6 * k, least_rms_rad=1e-6 * k
    )
    left = ns(
        played=played,
        fitted_rms_rad=4e-6 * k,
        difference=-0.25 * k,
        simulated_rms_rad=5e-6 * k,
        noise_rms_rad=6e-7 * k,
        reason=reason,
        beyond_loop_rad=beyond_rad,
    )
    return recorded.RecordedAxis(fit, left)


def two_played_axes():
    rough = {"white": False, "stationary": False, "reason": "a cause", "beyond_rad": 2e-7}
    calm = {"white": True, "stationary": True, "reason": "", "beyond_rad": 0.0}
    return [a_played_axis("tip", 1, **rough), a_played_axis("tilt", 2, **calm)]


def test_a_recording_of_two_unlike_axes_is_told_as_a_whole():
    loop = ns(timing=ns(step_s=1e-3, period_s=1.0 / 2000.0), disturbances=[[]])
    assert recorded.recording_text("a.csv", two_played_axes(), loop, "PI", 120).split("\n") == [
        (
            "Recording a.csv: 12.5 s at 800 Hz, each channel one axis, in place of the "
            "mission's vibration, wheels and body. Angles"
        ),
        "in µrad rms, drift in µrad/s.",
        "",
        "Recorded",
        "",
        " axis   mean   drift   rest   lines, amplitude",
        " ─────────────────────────────────────────────",
        " tip    1.00   2.50    4.08   12 Hz: 1.20",
        "                              37.5 Hz: 3.75",
        " tilt   2.00   5.00    8.16   24 Hz: 2.40",
        "                              75 Hz: 7.50",
        "",
        "Fitted",
        "",
        " axis   states   worst      white residual   stationary",
        " ──────────────────────────────────────────────────────",
        " tip    4        −0.75 dB   no, p = 0.062    no",
        " tilt   5        −1.50 dB   yes, p = 0.12    yes",
        "",
        "Left by the loop under PI",
        "",
        " axis     played   fitted   off by   simulated   mean    sensors",
        " ───────────────────────────────────────────────────────────────",
        " tip      3.00     4.00     −25 %    5.00        0.150   0.600",
        " tilt     6.00     8.00     −50 %    10.0        0.300   1.20",
        " radial   6.71     8.94     −25 %    11.2                1.34",
        "",
        (
            "Played from 500 ms to 11 s of the recording, mean and drift with it, through the "
            "linear loop from rest; fitted by"
        ),
        (
            "covariance, exactly; simulated on the mission's mirror with its hysteresis, "
            "limits and quantisation. All about their"
        ),
        "mean; what the sensors add stands beside them.",
        (
            "Warning: the recording ends at 400 Hz, and the loop reads up to 1 kHz: faster "
            "motion is not played, and the fit only"
        ),
        "goes on as it ended. Record faster.",
        "tip: 0.200 µrad above 500 Hz, half of the plant's rate, are cut off.",
        (
            "tip: the one-step-ahead residual of the fit is not white below 320 Hz (largest "
            "autocorrelation 0.031): the spectrum has"
        ),
        "more in it than the fit.",
        ("tip: not stationary, a reason. A spectrum is its average; in the loudest eighth the loop leaves 7.00 µrad."),
        "tip: played and fitted differ by −25 %: a cause.",
        "tilt: played and fitted agree within 5 %.",
    ]


def test_the_data_of_a_recording_of_two_unlike_axes_as_a_whole():
    one, other = two_played_axes()
    first, second = recorded._axis_data(one), recorded._axis_data(other)
    assert rounded(first) == {
        "name": "tip",
        "mean_rad": 1e-06,
        "slope_rad_s": 2.5e-06,
        "rms_rad": 4.08248e-06,
        "lines": [{"frequency_hz": 12.0, "amplitude_rad": 1.2e-06}, {"frequency_hz": 37.5, "amplitude_rad": 3.75e-06}],
        "order": 4,
        "band_limited": True,
        "worst_db": -0.75,
        "worst_at_hz": 55.0,
        "correlation_s": 0.125,
        "whiteness": {"white": False, "lags": 21, "statistic": 7.5, "p_value": 0.0625, "largest": 0.03125},
        "stationarity": {
            "stationary": False,
            "reason": "a reason",
            "motion": {"ratio": 1.5, "usual": 2.5, "ratio_p": 0.1, "growth": 0.3, "growth_p": 0.2},
            "fast_part": {"ratio": 11.5, "usual": 12.5, "ratio_p": 10.1, "growth": 10.3, "growth_p": 10.2},
        },
        "left": {
            "begin_s": 0.5,
            "end_s": 11.0,
            "mean_rad": 1.5e-07,
            "played_rms_rad": 3e-06,
            "quietest_eighth_rms_rad": 1e-06,
            "loudest_eighth_rms_rad": 7e-06,
            "fitted_rms_rad": 4e-06,
            "simulated_rms_rad": 5e-06,
            "sensors_rms_rad": 6e-07,
            "cut_off_rms_rad": 2e-07,
            "difference": -0.25,
            "reason": "a cause",
        },
    }
    assert second["left"]["loudest_eighth_rms_rad"] == 14e-6 and second["order"] == 5


def test_the_radial_error_of_a_recording_has_each_of_its_four_kinds():
    assert rounded(dict(zip(recorded._RADIAL, recorded._radial(two_played_axes()), strict=True))) == {
        "played_rms_rad": 6.7082e-06,
        "fitted_rms_rad": 8.94427e-06,
        "sensors_rms_rad": 1.34164e-06,
        "simulated_rms_rad": 1.11803e-05,
    }


def test_the_budget_of_a_loop_is_drawn_with_each_part_total_and_change(fine):
    assert figure_of(figures.error_budget(fine.budget)) == [
        "fine-pointing-budget",
        "What the residual is made of",
        (
            "Error budget of PI + inverse in series. Above: each part by itself, simulated "
            "without hysteresis. Middle: combined. Below: what a part changes when it alone is "
            "left out of the full loop, as a root of the difference of squares."
        ),
        {
            "vibration (OLYMPUS) (rad)": [3e-06],
            "body pointing (rad)": [4e-07],
            "quantisation (rad)": [0.0],
            "root sum square of the parts (rad)": [3.02655e-06],
            "all together, without hysteresis (rad)": [3.03e-06],
            "all together, mission's mirror (rad)": [3.05e-06],
            "added by hysteresis (rad)": [3.48712e-07],
            "added by computation delay (rad)": [2.30272e-06],
            "vibration (OLYMPUS), theory (rad)": [3.1e-06],
            "body pointing, theory (rad)": [4.1e-07],
        },
        "Sheet width=7.6 height=3.14 legend=<place=above>",
        ("Panel 0 0 x=<title=radial rms (µrad) low=0 high=3.472> y=<low=-0.6 high=7.6 ticks={7: vibration"),
        "  (OLYMPUS), 6: body pointing, 5: quantisation, 4: root sum square of the parts, 3: all",
        ("  together, without hysteresis, 2: all together, mission's mirror, 1: added by hysteresis, 0:"),
        "  added by computation delay} grid=False>",
        "Bars at=[7 6 5] start=[0 0 0] end=[3 0.4 0] breadth=[0.65 0.65 0.65] colour=#56B4E9",
        ("Bars at=[4 3 2] start=[0 0 0] end=[3.02655 3.03 3.05] breadth=[0.65 0.65 0.65] colour=#0072B2"),
        "Bars at=[1 0] start=[0 0] end=[0.348712 2.30272] breadth=[0.65 0.65] colour=#E69F00",
        "Line x=[3.1 0.41 nan nan nan nan nan nan] y=[7 6 5 4 3 2 1 0] dash= label=theory (linear)",
        "  marker=| size=13 edge_width=1.8",
        "Words text=3.00 x=3.1 y=7 shift=[5 0]",
        "Words text=0.400 x=0.41 y=6 shift=[5 0]",
        "Words text=0 x=0 y=5 shift=[5 0]",
        "Words text=3.03 x=3.02655 y=4 shift=[5 0]",
        "Words text=3.03 x=3.03 y=3 shift=[5 0]",
        "Words text=3.05 x=3.05 y=2 shift=[5 0]",
        "Words text=0.349 x=0.348712 y=1 shift=[5 0]",
        "Words text=2.30 x=2.30272 y=0 shift=[5 0]",
        "Rule at=4.5 upright=False colour=#777777 width=0.8",
        "Rule at=1.5 upright=False colour=#777777 width=0.8",
    ]


def test_errors_are_drawn_by_controller_and_by_those_mirrors_that_each_was_simulated_on(fine, mission):
    less = replace(
        fine,
        verified=tuple(
            replace(v, simulated={key: r for key, r in v.simulated.items() if k or key != "comparison"})
            for k, v in enumerate(fine.verified)
        ),
    )
    assert figure_of(figures.errors(less, mission)) == [
        "fine-pointing-errors",
        "Radial error by controller",
        (
            "Simulated radial error that is not exceeded for 99.7 % of the time, by controller "
            "and variant of the mirror."
        ),
        {
            "PI, best of a gain grid, mission's mirror (rad)": [5.17e-06],
            "PI + inverse in series, mission's mirror (rad)": [4.23e-06],
            "quick PI, mission's mirror (rad)": [6.41e-06],
            "PI + inverse in series, comparison model (rad)": [4.28e-06],
            "quick PI, comparison model (rad)": [6.46e-06],
            "PI, best of a gain grid, no hysteresis (rad)": [5.27e-06],
            "PI + inverse in series, no hysteresis (rad)": [4.33e-06],
            "quick PI, no hysteresis (rad)": [6.51e-06],
        },
        "Sheet width=7.6 height=2.38 legend=<place=above columns=4>",
        "Panel 0 0 x=<title=radial error at 99.7 % of the time (µrad) low=0> y=<low=-0.6 high=2.6",
        "  ticks={2: PI, best of a gain grid, 1: PI + inverse in series, 0: quick PI}>",
        ("Line x=[5.17 4.23 6.41] y=[2.22 1.22 0.22] colour=#0072B2 dash= label=mission's mirror marker=o"),
        "  edge=#0072B2",
        ("Line x=[4.28 6.46] y=[1 0] colour=#E69F00 dash= label=comparison model marker=s edge=#E69F00"),
        ("Line x=[5.27 4.33 6.51] y=[1.78 0.78 -0.22] colour=#ffffff dash= label=no hysteresis marker=D"),
        "  edge=#000000",
        "Rule at=10 upright=True dash=-- width=1.2 label=required: 10 µrad",
    ]


def budget_of_unlike_parts():
    parts = (Part("OLYMPUS", 3e-6, 3.5e-6), Part("noise", 4e-6, 4.5e-6), Part("quantisation", 6e-8, math.nan))
    changes = (Difference("hysteresis", 7e-6, 6e-6), Difference("computation delay", 7e-6, 7.5e-6))
    return ErrorBudget("LQG", parts, 5e-6, 5.25e-6, changes)


def test_the_tables_of_a_loops_budget_have_each_number_of_each_part():
    of = ns(budget=budget_of_unlike_parts())
    assert views_text([section.budget_view(of)], 110).split("\n") == [
        "Error budget of LQG",
        "",
        (
            "Without hysteresis the parts combine to what they leave together, to within "
            "0.0072 %. With it they still do,"
        ),
        "to within 5 %: the loop counts as linear.",
        "",
        (" part, by itself and without hysteresis   simulated, rms (µrad)   theory, rms (µrad)   share of variance"),
        (" ───────────────────────────────────────────────────────────────────────────────────────────────────────"),
        (" vibration (OLYMPUS)                      3.00                    3.50                 36.0 %"),
        (" noise                                    4.00                    4.50                 64.0 %"),
        (" quantisation                             0.060                                        < 0.1 %"),
        " Root sum square of the parts             5.00                    5.70",
        " All together, without hysteresis         5.00",
        " All together, the mission's mirror       5.25",
        "",
        " left out of the full loop   rms with it (µrad)   without it (µrad)   it adds (µrad)",
        " ───────────────────────────────────────────────────────────────────────────────────",
        " hysteresis                  7.00                 6.00                3.61",
        " computation delay           7.00                 7.50                −2.69",
        "",
        "Added is the root of the difference of the squares; it is negative where the part helps.",
    ]
    assert rounded(plain_data._budget(of.budget)) == {
        "controller": "LQG",
        "parts": [
            {"name": "OLYMPUS", "rms_rad": 3e-06, "theory_rms_rad": 3.5e-06},
            {"name": "noise", "rms_rad": 4e-06, "theory_rms_rad": 4.5e-06},
            {"name": "quantisation", "rms_rad": 6e-08, "theory_rms_rad": "nan"},
        ],
        "combined_rms_rad": 5.00036e-06,
        "together_without_hysteresis_rms_rad": 5e-06,
        "full_rms_rad": 5.25e-06,
        "linear": True,
        "dominant": "noise",
        "differences": [
            {"name": "hysteresis", "with_rms_rad": 7e-06, "without_rms_rad": 6e-06, "added_rms_rad": 3.60555e-06},
            {
                "name": "computation delay",
                "with_rms_rad": 7e-06,
                "without_rms_rad": 7.5e-06,
                "added_rms_rad": -2.69258e-06,
            },
        ],
    }


def few_counts(*at):
    """A histogram with so many samples in the bins of these places."""
    counts = np.zeros(bin_edges_rad().size - 1, dtype=np.int64)
    for place, count in at:
        counts[place] = count
    return counts


def a_residual(k, *at):
    return Residual(2e-6 * k, 0.05e-6 * k, (1.4e-6, 1.5e-6), (0.0, 0.0), few_counts(*at), 4e-6 * k, 9e-6 * k, {})


def two_tails():
    given = a_residual(1, (300, 400), (310, 500), (330, 99), (350, 1))
    other = a_residual(2, (320, 600), (340, 400))
    best = ns(design=ns(name="LQG"), simulated={"given": given, "comparison": other})
    first = ns(design=ns(name="PI"), simulated={"given": a_residual(3, (305, 900), (345, 100))})
    return ns(best=best, verified=(first, best), quantile=0.95, scene=ns(table=ns(runs=12, seed=34)))


def test_two_tails_have_each_their_own_quantiles_and_samples():
    assert views_text([tails.tail_view(two_tails(), 5e-6, ())], 220).split("\n") == [
        "Monte Carlo tails",
        "",
        (
            "Radial error of the line of sight at the control samples of the ensemble: 12 runs "
            "with the seed 34, 1000 samples in all."
        ),
        (
            "Samples that follow each other are not independent. How many independent ones "
            "they are worth is taken from the scatter of the mean square from run to run; "
            "intervals are of 99 %, and none is given where fewer than 10 of"
        ),
        "those would lie beyond.",
        "",
        (
            " radial error (µrad)     50 %             90 %             95 %             99 %  "
            "            99.9 %            99.99 %           99.999 %          largest   time "
            "beyond 5 µrad          independent samples"
        ),
        (
            " "
            "──────────────────────────────────────────────────────────────────────────────────"
            "──────────────────────────────────────────────────────────────────────────────────"
            "────────────────────────────────────────"
        ),
        (
            " LQG, mission's mirror   0.099            0.101            0.153            0.155 "
            "            0.155             0.234             0.235             9.00      none "
            "seen, at most 0.95 %   690"
        ),
        (
            "                         0.099 to 0.100   0.101 to 0.153   0.153 to 0.154   too "
            "few samples   too few samples   too few samples   too few samples"
        ),
        (
            " LQG, comparison model   0.122            0.192            0.193            0.193 "
            "            0.193             0.193             0.193             18.0      none "
            "seen, at most 1.2 %    550"
        ),
        (
            "                         0.122 to 0.123   0.192 to 0.192   0.192 to 0.193   too "
            "few samples   too few samples   too few samples   too few samples"
        ),
        (
            " PI, mission's mirror    0.088            0.089            0.213            0.214 "
            "            0.215             0.215             0.215             27.0      none "
            "seen, at most 0.66 %   1000"
        ),
        (
            "                         0.088 to 0.088   0.089 to 0.212   0.212 to 0.214   0.214 "
            "to 0.215    too few samples   too few samples   too few samples"
        ),
        "",
        (
            "The radial error stays below each value for that share of the time; below it "
            "stands its 99 % interval. The requirement is judged at 95 %."
        ),
    ]


def test_two_tails_are_drawn_with_the_rayleigh_distribution_of_the_missions_mirror():
    found = figure_of(tails.tail(two_tails(), 5e-6))
    assert found[:3] == [
        "monte-carlo-tail",
        "Tail of the radial error",
        (
            "Share of the time that the radial error of LQG is larger, over all runs. A "
            "Gaussian error about both axes with equal rms would follow the dotted line; the "
            "scale ends at half a sample."
        ),
    ]
    assert [line for line in found[4:] if not line.startswith(("Line", "  "))] == [
        "Sheet width=7.4 height=3.8 legend=<place=above columns=3>",
        ("Panel 0 0 x=<title=radial error (µrad) low=0> y=<title=share of the time beyond it log=True"),
        "Rule at=5 upright=True dash=-- width=1.2 label=required: 5 µrad",
        "Rule at=0.05 upright=False colour=#777777 width=0.8",
        "Words text=beyond for 5 % of the time x=0.02 y=0.05 colour=#555555 base=bottom shift=[4 2]",
    ]


def test_stroke_sines_and_sources_of_a_made_up_study_as_a_whole(fine):
    views = [section.stroke_view(fine), section.sines_view(fine, 9.2e-6), section.residuals_view(fine, 5.2e-6)]
    assert views_text(views, 150).split("\n") == [
        "Stroke",
        "",
        (
            'The paper says that a travel of 2.5 mrad would "fully cover" the residual of the '
            "body pointing. The travel of 2.5 mrad from stop to stop (optical"
        ),
        (
            "angle) is 1.25 mrad to either side; the worst case needs 623 µrad with the "
            "point-ahead on the mirror and 552 µrad with the point-ahead elsewhere: the"
        ),
        (
            "travel covers both. The drive of 0 to 12 V about its bias of 6 V reaches 43 % of "
            "the travel, 534 µrad to either side. With the point-ahead on the"
        ),
        (
            "mirror the worst case misses by 89.1 µrad on axis x; the root sum square fits. "
            "With the point-ahead elsewhere the worst case misses by 18.1 µrad on"
        ),
        (
            "axis x; the root sum square fits. So the claim holds for the travel, and not for "
            "the drive that the mirror was identified with."
        ),
        "",
        "The stroke line by line",
        "",
        " half range (µrad)",
        " pairs: worst case / root sum square          x             y             x             y",
        (" ──────────────────────────────────────────────────────────────────────────────────────────────────"),
        (" Body pointing                                300           300           300           300"),
        " Point-ahead                                  71.0          0             0             0",
        (" Bias and alignment                           248           248           248           248"),
        " Line-of-sight rate lag                       4.06          0             4.06          0",
        (" Total at the line of sight                   623 / 396     548 / 389     552 / 389     548 / 389"),
        (" Needed at the mirror, optical angle          623 / 396     548 / 389     552 / 389     548 / 389"),
        (" Available there: half of the usable travel   534           534           534           534"),
        (" Margin                                       −89.1 / 138   −14.0 / 145   −18.1 / 145   −14.0 / 145"),
        (" Fits                                         no / yes      no / yes      no / yes      no / yes"),
        (" Largest telescope magnification              0.86 / 1.35   0.97 / 1.37   0.97 / 1.37   0.97 / 1.37"),
        "",
        (
            "- Body pointing: half range at the line of sight: x 300 µrad, y 300 µrad. paper: "
            "section 2.1, attitude control accuracy taken as reference"
        ),
        (
            "- Point-ahead: half range at the line of sight: x 71 µrad, y 0 rad. assumption: 2 "
            "v / c at 10.65 km/s across the line of sight, the most from a 500 km"
        ),
        "  sun-synchronous orbit",
        (
            "- Bias and alignment: half range at the line of sight: x 248 µrad, y 248 µrad. "
            "derived: what beacon.divergence leaves behind the two lines above, 390"
        ),
        "  urad half angle; the paper prints no value",
        (
            "- Line-of-sight rate lag: half range at the line of sight: x 4.058 µrad, y 0 rad. "
            "assumption: the most from a 500 km sun-synchronous orbit, at about"
        ),
        ("  42 000 km; assumption: the body turns with the predicted line of sight but for 1 % of its rate"),
        "",
        (
            "The root sum square supposes independent terms of one class; ECSS-E-ST-60-10C "
            "does not grant that to bias and random terms together."
        ),
        "",
        "The paper's sines under vibration and noise",
        "",
        (
            "Fig. 6 and 8 again: a 300 µrad sine on axis x with vibration and sensor noise on "
            "both axes. Body pointing and point-ahead are left out: the stroke"
        ),
        (
            "would not hold them beside it. Radial error in µrad: rms / 99.7 %. While a sine "
            "of the paper is tracked on the mission's mirror, the requirement is"
        ),
        (
            "met at 1 Hz by PI, best of a gain grid and PI + inverse in series; at 25 Hz by "
            "none (least: 9.63 µrad, PI, best of a gain grid)."
        ),
        "",
        " controller                1 Hz               25 Hz              1 Hz               25 Hz",
        (" ───────────────────────────────────────────────────────────────────────────────────────────────────"),
        (" PI, best of a gain grid   2.00 / 7.23 PASS   2.00 / 9.63 FAIL   2.00 / 7.23 PASS   2.00 / 9.63 FAIL"),
        (" PI + inverse in series    3.00 / 8.23 PASS   3.00 / 10.6 FAIL   3.00 / 8.23 PASS   3.00 / 10.6 FAIL"),
        (" quick PI                  4.00 / 9.23 FAIL   4.00 / 11.6 FAIL   4.00 / 9.23 FAIL   4.00 / 11.6 FAIL"),
        "",
        "What each controller leaves",
        "",
        (
            "Radial error at the line of sight in µrad: rms in theory (linear: no hysteresis, "
            "no limits), then as simulated on each variant of the mirror."
        ),
        "Required: at most 5.2 µrad for 99.7 % of the time.",
        "",
        (
            " controller                rms    rms           99.7 %      largest   rms         "
            "  99.7 %      largest   rms           99.7 %      largest"
        ),
        (
            " "
            "──────────────────────────────────────────────────────────────────────────────────"
            "────────────────────────────────────────────────────────"
        ),
        (
            " PI, best of a gain grid   1.58   2.11 ± 0.01   5.17 PASS   7.39      2.22 ± 0.01 "
            "  5.22 FAIL   7.44      1.58 ± 0.01   5.27 FAIL   7.49"
        ),
        (
            " PI + inverse in series    1.72   2.25 ± 0.01   4.23 PASS   6.45      2.36 ± 0.01 "
            "  4.28 PASS   6.50      1.74 ± 0.01   4.33 PASS   6.55"
        ),
        (
            " quick PI                  1.55   2.40 ± 0.01   6.41 FAIL   8.63      2.51 ± 0.01 "
            "  6.46 FAIL   8.68      1.58 ± 0.01   6.51 FAIL   8.73"
        ),
        "",
        (
            "± is the 99 % interval of the rms over the runs. Bold and shaded: the best, by "
            "its error at 99.7 % on the mission's mirror; the first is the baseline."
        ),
        "",
        ("No controller met a limit: none saturates, none is beyond what was identified, and no spot is lost."),
    ]


def test_all_that_is_said_of_a_made_up_study(fine, mission):
    said = [*words.result(fine, 5.2e-6), *words.theory(fine), *words.short(fine, 5.2e-6), *words.stroke(fine)]
    assert [*said, section.setting(fine), *warned(fine, mission)] == [
        (
            "PI + inverse in series is the best of 3 controllers: on the mission's mirror the "
            "radial error stays within 4.23 µrad for 99.7 % of the time (2.25 µrad rms, 6.45 "
            "µrad at most). The 5.2 µrad required are met."
        ),
        "Vibration (OLYMPUS) makes up most of it: 3.00 µrad of 3.05 µrad rms, which add as squares.",
        ("The same controller leaves 4.28 µrad on the comparison model and 4.33 µrad without hysteresis."),
        "The requirement is missed by quick PI.",
        (
            "Against the best PI of the gain grid (2.11 µrad rms, 5.17 µrad at 99.7 %) the rms "
            "of PI + inverse in series is 6.8 % higher."
        ),
        (
            "With hysteresis left out, no linear controller comes below 1.51 µrad rms, "
            "whatever its margins. The baseline is at 1.58 µrad, so at most 4.8 % are to be "
            "gained over it; quick PI comes nearest, with 1.55 µrad."
        ),
        "So no linear controller can be 20 % better than the baseline.",
        "The question of a better linear controller is settled: at most 3 % are left.",
        (
            "On the mission's mirror hysteresis brings the baseline to 2.11 µrad. Without it "
            "the rms could be at most 29 % lower; PI + inverse in series is 0 % lower."
        ),
        (
            "Fine pointing under vibration and noise: PI + inverse in series leaves 4.23 µrad "
            "radial at 99.7 % (2.25 µrad rms); 5.2 µrad is allowed."
        ),
        (
            "While a sine of the paper is tracked on the mission's mirror, the requirement is "
            "met at 1 Hz by none (least: 7.23 µrad, PI, best of a gain grid); at 25 Hz by none "
            "(least: 9.63 µrad, PI, best of a gain grid)."
        ),
        (
            "Without hysteresis no linear controller can be more than 4.8 % better (rms) than "
            "the best PI of the gain grid; on the mission's mirror PI + inverse in series is "
            "6.8 % worse."
        ),
        ("The mirror's stroke does not cover the worst case: axis x needs 623 µrad to either side and has 534 µrad."),
        (
            'The paper says that a travel of 2.5 mrad would "fully cover" the residual of the '
            "body pointing. The travel of 2.5 mrad from stop to stop (optical angle) is 1.25 "
            "mrad to either side; the worst case needs 623 µrad with the point-ahead on the "
            "mirror and 552 µrad with the point-ahead elsewhere: the travel covers both."
        ),
        ("The drive of 0 to 12 V about its bias of 6 V reaches 43 % of the travel, 534 µrad to either side."),
        ("With the point-ahead on the mirror the worst case misses by 89.1 µrad on axis x; the root sum square fits."),
        ("With the point-ahead elsewhere the worst case misses by 18.1 µrad on axis x; the root sum square fits."),
        ("So the claim holds for the travel, and not for the drive that the mirror was identified with."),
        (
            "Control at 5 kHz with 200 µs of delay, sensor noise 1 µrad rms per axis and "
            "reading; disturbances, rms per axis before the loop: OLYMPUS 11.2 µrad and body "
            "pointing 100 µrad. Simulated: 64 runs of 2 s each, the first 500 ms left out, "
            "seed 1. A design has to keep a modulus margin of 0.5."
        ),
        (
            "fine pointing: the stroke does not cover the worst case on axis x: 623 µrad "
            "needed to either side, 534 µrad available (root sum square 396 µrad); the "
            "simulated runs leave out the biases of [pointing], so they may stay within limits "
            "that the worst case exceeds"
        ),
        (
            "fine pointing: the stroke does not cover the worst case on axis y: 548 µrad "
            "needed to either side, 534 µrad available (root sum square 389 µrad); the "
            "simulated runs leave out the biases of [pointing], so they may stay within limits "
            "that the worst case exceeds"
        ),
        (
            "fine pointing: judged at 5 kHz, 200 µs of delay, an amplifier of 1 kHz; the "
            "paper's loop runs at 50 kHz, 20 µs of delay, an amplifier of 5 kHz: one does not "
            "stand for the other"
        ),
    ]


# ------------------------------------------------------------------------------------------ quantities as they are told
@pytest.mark.parametrize(
    ("value", "unit", "digits", "text", "with_sign"),
    [
        (-0.004, "dB", 3, "−0.004 dB", "−0.004 dB"),  # two decimals would make a shortfall none
        (-0.0004, "dB", 3, "−0.0004 dB", "−0.0004 dB"),
        (-0.005, "dB", 3, "−0.005 dB", "−0.005 dB"),
        (-0.0051, "dB", 3, "−0.01 dB", "−0.01 dB"),
        (0.004, "dB", 3, "0.00 dB", "+0.00 dB"),
        (-1e-13, "dB", 3, "0.00 dB", "+0.00 dB"),
        (12.3456, "dB", 5, "12.3456 dB", "+12.3456 dB"),
        (-12.3456, "dBm", 3, "−12.35 dBm", "−12.35 dBm"),
        (-4.2e-6, "rad", 3, "−4.2 µrad", "−4.2 µrad"),
        (622.08e6, "bit/s", 5, "622.08 Mbit/s", "+622.08 Mbit/s"),
        (622.08e6, "bit/s", 3, "622 Mbit/s", "+622 Mbit/s"),
        (-math.inf, "dB", 3, "−inf dB", "−inf dB"),
        (math.inf, "dB", 4, "inf dB", "+inf dB"),
        (9.9e-21, "", 3, "below 1e-20", "+below 1e-20"),
    ],
)
def test_a_quantity_has_its_digits_and_a_shortfall_is_never_none(value, unit, digits, text, with_sign):
    assert (quantities.quantity(value, unit, digits), quantities.signed(value, unit, digits)) == (text, with_sign)


@pytest.mark.parametrize(
    ("name", "value", "text"),
    [
        ("micro", 1e-9, "0.001"),
        ("micro", 0.9995e-9, "< 0.001"),
        ("micro", -0.04e-6, "−0.040"),
        ("micro", 99.94e-6, "99.9"),
        ("micro", 99.951e-6, "100"),
        ("micro", -0.25e-3, "−250"),
        ("micro", 9.994e-6, "9.99"),
        ("micro", 9.999e-6, "10.0"),
        ("micro", -0.99996e-6, "−1.00"),
        ("micro", -0.5e-9, "> −0.001"),
        ("micro", 12.3456e-3, "12346"),
        ("angle", 0.99996e-3, "1 mrad"),
        ("angle", 999.4e-6, "999 µrad"),
        ("angle", 1e-3, "1 mrad"),
        ("angle", -0.5e-3, "−500 µrad"),
        ("given_angle", 12.34567e-6, "12.35 µrad"),
        ("given_angle", 0.3e-3, "300 µrad"),
        ("percent", 1.001e-5, "0.001 %"),
        ("percent", 0.99e-5, "< 0.001 %"),
        ("percent", 12.3456, "1200 %"),
        ("percent", -0.0345, "−3.5 %"),
        ("percent", -5e-6, "> −0.001 %"),
        ("share_of_time", 0.99865, "99.865 %"),
        ("share_of_time", 0.5, "50 %"),
        ("share_of_time", 0.9999999, "99.99999 %"),
        ("share_of_time", 0.9999999999999, "99.99999999999 %"),
        ("share_of_time", 0.07, "7 %"),
        ("volume", 8e9, "1 GB"),
        ("volume", 622.08e6 * 60.0, "4.67 GB"),
        ("duration", math.inf, "never"),
        ("duration", 90061.0, "25 h"),
        ("duration", -150.0, "−2.5 min"),
        ("duration", 3.6e7, "10000 h"),
        ("duration", 0.0123456, "0.0123 s"),
        ("power_text", 1e5, "10⁵"),
        ("power_text", -1e5, "−10⁵"),
        ("power_text", 9.9996, "10¹"),
        ("power_text", 2.4999e-7, "2.5×10⁻⁷"),
        ("power_text", -3.14159e22, "−3.14×10²²"),
        ("minus", "-3 to -inf, a-4, 1e-5 and (-0.5)", "−3 to −inf, a-4, 1e-5 and (−0.5)"),
    ],
)
def test_each_kind_of_number_as_it_is_told(name, value, text):
    assert getattr(quantities, name)(value) == text


@pytest.mark.parametrize(
    ("one", "other", "unit", "told"),
    [
        (622.08e6, 622.09e6, "bit/s", ("622.08 Mbit/s", "622.09 Mbit/s")),
        (622.084e6, 622.0841e6, "bit/s", ("622.084 Mbit/s", "622.0841 Mbit/s")),
        (-3.001, -3.004, "dB", ("−3.001 dB", "−3.004 dB")),
        (1.0, 1.0000004, "W", ("1 W", "1 W")),
        (1.0, 1.000001, "W", ("1 W", "1.000001 W")),
    ],
)
def test_two_values_are_told_apart_by_up_to_seven_digits(one, other, unit, told):
    assert quantities.apart(one, other, unit) == told


# ------------------------------------------------------------------------------------------------ the page as a whole
def test_what_each_controller_leaves_stands_by_its_variant_with_limits_and_intervals(fine):
    met = with_residual(fine, THIRD, "comparison", shares={"saturated": 0.25, "lost": 1e-6})
    bare = replace(met.verified[0], simulated={"given": met.verified[0].simulated["given"]})
    met = replace(met, verified=(bare, *met.verified[1:]))
    assert outline(section.residuals_view(met, 4.5e-6)) == one_text("""
# What each controller leaves
Radial error at the line of sight in µrad: rms in theory (linear: no hysteresis, no limits), then as simulated on
  each variant of the mirror. Required: at most 4.5 µrad for 99.7 % of the time.
| -: controller / rms / rms / 99.7 % / largest / rms / 99.7 % / largest / rms / 99.7 % / largest [0] best [1]  1,
  theory 1, mission's mirror 3, comparison model 3, no hysteresis 3
PI, best of a gain grid / 1.58 / 2.11 ± 0.01 / 5.17 FAIL / 7.39 /  /  /  /  /  /
PI + inverse in series / 1.72 / 2.25 ± 0.01 / 4.23 PASS / 6.45 / 2.36 ± 0.01 / 4.28 PASS / 6.50 / 1.74 ± 0.01 / 4.33
  PASS / 6.55
quick PI / 1.55 / 2.40 ± 0.01 / 6.41 FAIL / 8.63 / 2.51 ± 0.01 / 6.46 FAIL / 8.68 / 1.58 ± 0.01 / 6.51 FAIL / 8.73
± is the 99 % interval of the rms over the runs. Bold and shaded: the best, by its error at 99.7 % on the mission's
  mirror; the first is the baseline.
Limits met, as a share of control samples (saturation, lost spot, the inverse's rate) or plant steps:
- quick PI, comparison model: 25 % saturated, < 0.001 % lost
""")


def test_the_sines_stand_by_variant_and_one_that_was_not_run_is_empty(fine):
    of = replace(fine, sines=fine.sines[1:])
    assert outline(section.sines_view(of, 9.5e-6)) == one_text("""
# The paper's sines under vibration and noise (folded)
Fig. 6 and 8 again: a 300 µrad sine on axis x with vibration and sensor noise on both axes. Body pointing and point-
  ahead are left out: the stroke would not hold them beside it. Radial error in µrad: rms / 99.7 %. While a sine of
  the paper is tracked on the mission's mirror, the requirement is met at 25 Hz by none (least: 9.63 µrad, PI, best
  of a gain grid); at 1 Hz by all controllers.
| -: controller / 25 Hz / 1 Hz / 1 Hz / 25 Hz [0] best [1]  1, mission's mirror 2, comparison model 2
PI, best of a gain grid / 2.00 / 9.63 FAIL /  / 2.00 / 7.23 PASS / 2.00 / 9.63 FAIL
PI + inverse in series / 3.00 / 10.6 FAIL / 3.00 / 8.23 PASS / 3.00 / 8.23 PASS / 3.00 / 10.6 FAIL
quick PI / 4.00 / 11.6 FAIL / 4.00 / 9.23 PASS / 4.00 / 9.23 PASS / 4.00 / 11.6 FAIL
""")
    assert section.sines_view(replace(fine, sines=()), 9.5e-6) is None


def test_the_parts_of_a_loop_that_counts_as_linear_stand_beside_what_the_rest_adds(fine):
    assert outline(section.budget_view(fine)) == one_text("""
# Error budget of PI + inverse in series
Without hysteresis the parts combine to what they leave together, to within 0.11 %. With it they still do, to within
  0.77 %: the loop counts as linear.
| -: part, by itself and without hysteresis / simulated, rms (µrad) / theory, rms (µrad) / share of variance [0]
  totals 3
vibration (OLYMPUS) / 3.00 / 3.10 / 98.3 %
body pointing / 0.400 / 0.410 / 1.7 %
quantisation / 0 /  / 0 %
Root sum square of the parts / 3.03 / 3.13 /
All together, without hysteresis / 3.03 /  /
All together, the mission's mirror / 3.05 /  /
| -: left out of the full loop / rms with it (µrad) / without it (µrad) / it adds (µrad) [0]
hysteresis / 3.05 / 3.03 / 0.349
computation delay / 3.05 / 2.00 / 2.30
Added is the root of the difference of the squares; it is negative where the part helps.
""")


def tables_of(module, monkeypatch, made):
    """The outline of the tables that a text for a terminal is made of."""
    seen = []
    monkeypatch.setattr(module, "tables_text", lambda tables, said, width: seen.extend(tables) or "text")
    made()
    return outline(*seen)


def test_the_tables_of_a_recording_have_words_and_sums_where_they_are(monkeypatch):
    loop = ns(timing=ns(step_s=1e-3, period_s=1.0 / 2000.0), disturbances=[[]])
    both = tables_of(recorded, monkeypatch, lambda: recorded.recording_text("a", two_played_axes(), loop, "PI", 99))
    left = "| Left by the loop under PI: axis / played / fitted / off by / simulated / mean / sensors [0]"
    assert [line for line in both.split("\n") if line.startswith("|")] == [
        "| Recorded: axis / mean / drift / rest / lines, amplitude [0, 4]",
        "| Fitted: axis / states / worst / white residual / stationary [0, 3, 4]",
        f"{left} totals 1",
    ]
    alone = tables_of(
        recorded, monkeypatch, lambda: recorded.recording_text("a", two_played_axes()[:1], loop, "PI", 99)
    )
    assert f"{left}\n" in alone and "radial" not in alone


def test_errors_in_windows_stand_by_source_with_a_sum_and_what_filters_make_of_those_with_a_window(monkeypatch):
    first, second = two_indices()

    def of(index, left, before, rational):
        named = ({"OLYMPUS": one * 1e-6, "body": other * 1e-6} for one, other in (left, before))
        return ns(index=index, left=next(named), before=next(named), rational=rational)

    errors = [
        of(ErrorIndex("APE"), (3.0, 4.0), (6.0, 8.0), 9e-6),
        of(first, (1.0, 0.0), (5.0, 12.0), 1.43e-5),
        of(second, (2.0, 1.5), (0.0, 0.0), 1e-6),
        of(second, (2.0, 2.0), (1.0, 0.0), math.nan),
    ]
    assert tables_of(windows, monkeypatch, lambda: windows.windows_text(errors, "PI", 99)) == one_text("""
| Left by the loop under PI: source / APE / RPE; 250 ms / PDE; 500 ms; 8 s apart / PDE; 500 ms; 8 s apart [0] totals
  1
vibration (OLYMPUS) / 3.00 / 1.00 / 2.00 / 2.00
body / 4.00 / 0 / 1.50 / 2.00
all / 5.00 / 1.00 / 2.50 / 2.83
| Without the loop: source / APE / RPE; 250 ms / PDE; 500 ms; 8 s apart / PDE; 500 ms; 8 s apart [0] totals 1
vibration (OLYMPUS) / 6.00 / 5.00 / 0 / 1.00
body / 8.00 / 12.0 / 0 / 0
all / 10.0 / 13.0 / 0 / 1.00
| Without the loop, by linear filters: index / exact / rational / off by [0]
RPE 250 ms / 13.0 / 14.3 / 10 %
""")
    kept = [(each["left_rad"]["all"], each["without_the_loop_rational_rad"]) for each in windows.windows_data(errors)]
    assert [all_of for all_of, _ in kept] == pytest.approx([5e-6, 1e-6, 2.5e-6, math.sqrt(8.0) * 1e-6])
    assert [rational for _, rational in kept] == [9e-6, 1.43e-5, 1e-6, None]


def test_simulated_windows_have_their_interval_what_was_left_out_lost_and_coded():
    first, second = two_indices()
    errors = [
        ns(index=first, linear_rad=1e-6, rms_rad=1.25e-6, interval_rad=5e-8, axis_rms_rad=np.array([1e-6, 7.5e-7])),
        ns(index=second, linear_rad=2e-6, rms_rad=2.5e-6, interval_rad=math.inf, axis_rms_rad=np.array([2e-6, 1.5e-6])),
    ]
    shares = ns(value=0.0125, low=0.01, high=0.02), ns(value=0.5, low=0.25, high=0.75)
    lost = ns(code_word_s=2e-4, words=4000, lost=shares[0], time=shares[1])
    ratio = ns(value=1e-7, low=5e-8, high=math.inf)
    given = {"code": "LDPC", "on_axis_db": 4.5, "target": 1e-6, "ratio": ratio, "penalty_db": 1.25, "span_s": 0.01}
    coded = ns(interleaving="block", **given)
    assert outline(simulated_windows.simulated_view(errors, lost, 12, [second, first], coded)) == one_text("""
# Simulated, with hysteresis
| Simulated, with hysteresis: index / linear / simulated / 99 % interval [0]
RPE 250 ms / 1.00 / 1.25 / ± 0.050
PDE 500 ms 8 s apart / 2.00 / 2.50 / unknown
- Radial rms in µrad, both at the control samples: linear in theory, simulated on the mission's mirror. Number of
  runs: 12; their spread gives the interval.
- Longer than a run behind its settling, and left out: PDE 500 ms 8 s apart, RPE 250 ms.
| Lost to pointing, simulated: share of / lost / 99 % interval [0]
code words of 200 µs / 1.25 % / 1 % to 2 %
time / 50 % / 25 % to 75 %
- Of 4000 code words those whose mean power is less than the required margin asks for, and the share of the time
  with less than that. Where none or all are lost, the interval takes them as independent.
| Coded link, simulated: of the coded link / value / 99 % interval [0]
mean bit error ratio / 10⁻⁷ / unknown
power that pointing costs / 1.25 dB /
- LDPC, BPSK with soft decisions, with a block interleaver over 10 ms, at 4.50 dB more on the axis than the code
  needs at constant power; the cost brings the mean back to 10⁻⁶. Power falls with each simulated error as that of a
  Gaussian beam, and stands still over a control sample.
""")
    coded.interleaving, coded.penalty_db, coded.ratio.high = "none", math.inf, 2e-7
    assert outline(simulated_windows.simulated_view(errors[:1], None, 1, (), coded)) == one_text("""
# Simulated, with hysteresis
| Simulated, with hysteresis: index / linear / simulated / 99 % interval [0]
RPE 250 ms / 1.00 / 1.25 / ± 0.050
- Radial rms in µrad, both at the control samples: linear in theory, simulated on the mission's mirror. Number of
  runs: 1; their spread gives the interval.
| Coded link, simulated: of the coded link / value / 99 % interval [0]
mean bit error ratio / 10⁻⁷ / 5×10⁻⁸ to 2×10⁻⁷
power that pointing costs / beyond 20 dB /
- LDPC, BPSK with soft decisions, without an interleaver, at 4.50 dB more on the axis than the code needs at
  constant power; the cost brings the mean back to 10⁻⁶. Power falls with each simulated error as that of a Gaussian
  beam, and stands still over a control sample.
""")
    assert [each["interval_rad"] for each in simulated_windows._indices(errors)] == [5e-8, None]


@pytest.mark.parametrize(
    ("values", "units", "said"),
    [
        ({"gain": 1234.5, "lead": 0.5}, {"gain": "Hz"}, "gain 1.23 kHz, lead 0.5"),
        ({"shift": -0.25, "time": 2e-3}, {"time": "s", "shift": ""}, "shift −0.25, time 2 ms"),
        ({"gain": 1234.5}, {}, "gain 1230"),
        ({}, {"a": "s"}, ""),
    ],
)
def test_what_a_controller_was_tuned_to_has_the_units_that_there_are(values, units, said):
    assert words.tuned_to(values, units) == said


@pytest.mark.parametrize(
    ("rms", "half", "said"),
    [
        (2.11e-6, 0.012e-6, "2.11 ± 0.01"), (2.11e-6, 0.2e-6, "2.1 ± 0.2"), (12.34e-6, 3e-6, "12 ± 3"),
        (12.34e-6, 30e-6, "12 ± 30"), (2.1111e-6, 1e-10, "2.111 ± 0.001"), (2.11e-6, 0.0, "2.11"),
        (2.11e-6, math.inf, "2.11"), (2.11e-6, 0.1001e-6, "2.1 ± 0.1"),
    ],
)  # fmt: skip
def test_an_rms_has_the_decimals_that_its_interval_leaves_it(rms, half, said):
    assert section.with_interval(ns(rms_rad=rms, rms_interval_rad=half)) == said


@pytest.mark.parametrize(
    ("name", "given", "text"),
    [
        *(("duration", (119.4,), "119 s"), ("duration", (120.0,), "2 min"), ("duration", (7199.0,), "120 min")),
        *(("duration", (7200.0,), "2 h"), ("duration", (0.0,), "0 s"), ("duration", (-7200.0,), "−2 h")),
        *(("counted", (0, "row"), "0 rows"), ("counted", (1, "row"), "1 row")),
        *(("are", (0,), "are"), ("are", (1,), "is"), ("are", (2,), "are"), ("percent", (0.0,), "0 %")),
        *(("percent", (0.12345, 4), "12.35 %"), ("percent", (-1.0,), "−100 %"), ("plain", (-1e21,), "−1e+21")),
        *(("plain", (123456.0, 2), "120000"), ("plain", (math.inf,), "inf"), ("volume", (0.0,), "0 B")),
        *(("power_text", (0.00096, 2), "9.6×10⁻⁴"), ("power_text", (1.0,), "10⁰"), ("power_text", (0.0,), "0")),
        *(("micro", (math.nan,), ""), ("micro", (math.inf,), "inf"), ("angle", (0.0,), "0 µrad")),
    ],
)
def test_numbers_at_the_turns_of_their_units_and_with_digits_of_their_own(name, given, text):
    assert getattr(quantities, name)(*given) == text


def test_a_bandwidth_of_a_kilohertz_and_more_has_no_power_of_ten(fine):
    margins = replace(fine.verified[0].design.loop_margins, bandwidth_hz=1234.0, crossover_hz=2344.0)
    assert section.design_cells("as it is", margins, ())[6:8] == ("1230", "2340")


def test_a_worst_case_of_one_draw_and_one_corner_says_so():
    one = a_worst_case()
    one.extent.draws, one.corners, one.most_sensitive = 1, 1, one.most_sensitive[:1]
    said = " ".join(worst_case.worst_case_text(one, 110).split())
    assert "on 1 mirror drawn from" in said and "on 1 corner of its 1 most sensitive parameter at 2.5" in said


def test_an_inverse_in_series_is_drawn_before_the_lowest_in_theory(fine):
    first, second, third = fine.verified[:3]
    lowest = replace(third, theory=SimpleNamespace(radial_rms_rad=0.0))
    best = replace(fine, verified=(first, second, lowest), best=first)
    assert [each.name for each in figures.shown(best)] == [controller_study.BASELINE, SECOND, THIRD]


def test_parameters_have_their_units_alone_and_by_loop_but_for_controllers_that_a_plant_cannot_have(monkeypatch):
    def family(**units):
        parameters = [SimpleNamespace(name=name, unit=unit) for name, unit in units.items()]
        return SimpleNamespace(parameters=lambda plant: parameters if plant == "plant" else [])

    def refused(plant):
        raise ValueError("no resonance")

    given = [family(gain="", corner="Hz"), SimpleNamespace(parameters=refused), family(lag="s")]
    monkeypatch.setattr(plain_data, "families", lambda table: given if table == "table" else [])
    monkeypatch.setattr(plain_data, "H_INFINITY_OF_AXES", family(weight="rad/s"))
    units = plain_data.parameter_units(SimpleNamespace(one_axis="plant", table="table"))
    names = {"gain": "", "corner": "Hz", "lag": "s", "weight": "rad/s"}
    assert units == {f"{name}{of}": unit for name, unit in names.items() for of in ("", " x", " y", " 1", " 2")}


def test_the_spectra_of_a_loop_are_those_of_its_first_axis_controller_by_controller():
    """Two controllers on five frequencies, the second axis far quieter, the wheels' lines about that axis alone."""
    freq = np.array([0.0, 10.0, 20.0, 30.0, 40.0])
    before = 1e-12 * np.array([900.0, 70.0, 60.0, 50.0, 900.0])

    def controller(name, after, predicted):
        both = [1e-12 * np.c_[values, 1e-6 * np.array(values)] for values in (after, predicted)]
        return ns(design=ns(name=name), spectrum_rad2_hz=both[0], predicted_rad2_hz=both[1])

    plain = controller("plain", [900.0, 4.0, 5.0, 7.0, 1e-9], [900.0, 3.0, 2.0, 1.0, 900.0])
    best = controller("best", [900.0, 0.25, 0.75, 0.035, 1e-9], [900.0, 0.5, 0.125, 0.375, 900.0])
    loop = ns(
        optical=ns(noise_rad=3e-7, every=4), timing=ns(period_s=1e-3), disturbances=[[ns(lines=())], [ns(lines=(1,))]]
    )
    fine = ns(freq_hz=freq, disturbed_rad2_hz=before, scene=ns(loop=loop))
    shown = tuple(figures.Shown(of, *look) for of, look in ((plain, ("#111111", "o")), (best, ("#222222", "s"))))
    figure = figures.spectra(fine, shown)
    left, right = figure.sheet.panels
    assert [(line.label or line.name, line.colour, [*line.y.round(6)]) for line in left.all_of(Line)] == [
        ("before the loop", "#000000", [70.0, 60.0, 50.0]),
        ("plain", "#111111", [4.0, 5.0, 7.0]),
        ("plain, predicted, linear", "#111111", [3.0, 2.0, 1.0]),
        ("best", "#222222", [0.25, 0.75, 0.035]),
        ("best, predicted, linear", "#222222", [0.5, 0.125, 0.375]),
        ("dashed: predicted, linear", "#777777", []),
    ]
    gathered = [("plain", (4.0, 9.0, 16.0)), ("plain, predicted, linear", (3.0, 5.0, 6.0))]
    gathered += [("best", (0.25, 1.0, 1.035)), ("best, predicted, linear", (0.5, 0.625, 1.0))]
    for line, (name, sums) in zip(right.all_of(Line), gathered, strict=True):
        assert (line.label or line.name) == name
        assert_allclose(line.y, np.sqrt(10.0 * np.array(sums)), rtol=1e-9)
    assert [rule.at for rule in left.all_of(Rule)] == [pytest.approx(2.0 * 0.09 * 4e-3)]
    assert left.y.low == pytest.approx(0.01)  # a power of ten below the least that is left
    assert figure.caption.endswith(" Lines of the reaction wheel are not in the spectrum before the loop.")
    assert {name: [*np.round(1e12 * np.asarray(of), 6)] for name, of in figure.columns.items()} == {
        "frequency (Hz)": [1e13, 2e13, 3e13],
        "before the loop (rad^2/Hz)": [70.0, 60.0, 50.0],
        "plain, simulated (rad^2/Hz)": [4.0, 5.0, 7.0],
        "plain, predicted (rad^2/Hz)": [3.0, 2.0, 1.0],
        "best, simulated (rad^2/Hz)": [0.25, 0.75, 0.035],
        "best, predicted (rad^2/Hz)": [0.5, 0.125, 0.375],
    }


def test_a_recording_stands_in_place_of_the_angle_of_arrival_where_the_loop_has_one_about_its_first_axis():
    def disturbance(name):
        return ns(name=name, rms_rad=1.25e-6, basis="weak turbulence; fit of a filter", source="a paper")

    own, other = disturbance("angle of arrival"), disturbance("OLYMPUS")
    timing = ns(step_s=1e-3, period_s=1.0 / 2000.0)
    about = []
    for disturbances in ([[other, own], [other]], [[other], [own]]):
        loop = ns(timing=timing, disturbances=disturbances)
        text = recorded.recording_text("a.csv", two_played_axes(), loop, "PI", 300)
        about.append((text.split("in place of the mission's ")[1].split(".")[0], words.arrival(loop)))
    assert about == [
        (
            "vibration, wheels, angle of arrival and body",
            [
                "Angle of arrival, 1.25 µrad rms per axis before the loop: the tracked light comes down through the "
                "air of channel.turbulence, weak turbulence. Source: a paper."
            ],
        ),
        ("vibration, wheels and body", []),
    ]


@pytest.mark.parametrize(("rate_hz", "warned"), [(799.0, False), (800.0, False), (801.0, True)])
def test_a_recording_is_too_slow_for_a_loop_that_reads_faster_alone(rate_hz, warned):
    """The recording has 800 Hz."""
    loop = ns(timing=ns(step_s=1e-3, period_s=1.0 / rate_hz), disturbances=[[]])
    said = [each for each in recorded.sentences(two_played_axes(), loop) if each.startswith("Warning: ")]
    assert [each.split(": ")[1].partition(",")[0] for each in said] == ["the recording ends at 400 Hz"] * warned


def test_the_data_of_a_worst_case_of_two_indices_as_a_whole():
    found = WorstCase(
        controller="LQG",
        extent=Extent(draws=40, most_sensitive=2, sigmas=2.5),
        indices=two_indices(),
        corners=8,
        corners_left_out=1,
        unstable_draws=3,
        unstable_corners=2,
        nominal_rad=(1e-6, 2.5e-6),
        drawn_rad=(Quantiles(1.25e-6, 1.5e-6), Quantiles(2.75e-6, 3.125e-6)),
        largest_rad=(Worst(5e-6, {"alpha": 2.5}), Worst(4.5e-6, {"alpha": -1.25})),
        nominal_modulus=0.5625,
        drawn_modulus=Quantiles(0.53125, 0.4375),
        smallest_modulus=Worst(0.3125, {"alpha": 0.75}),
        most_sensitive=(Sensitivity("alpha", (0.01, -0.025), 0.002), Sensitivity("mode 1", (0.25, 0.5), -0.125)),
        verified_in_time=InTime(0.987654, "settles", "grows", 0.125, 3e-6),
    )
    assert worst_case.worst_case_data(found) == {
        "controller": "LQG",
        "extent": {"draws": 40, "most_sensitive": 2, "sigmas": 2.5},
        "corners": 8,
        "corners_left_out": 1,
        "unstable_draws": 3,
        "unstable_corners": 2,
        "nominal_modulus": 0.5625,
        "drawn_modulus": {"median": 0.53125, "worse": 0.4375},
        "smallest_modulus": {"value": 0.3125, "sigmas": {"alpha": 0.75}},
        "most_sensitive": (
            {"parameter": "alpha", "rms": (0.01, -0.025), "modulus": 0.002},
            {"parameter": "mode 1", "rms": (0.25, 0.5), "modulus": -0.125},
        ),
        "errors": [
            {
                "index": "RPE",
                "window_s": 0.25,
                "spacing_s": None,
                "nominal_rad": 1e-6,
                "drawn_rad": {"median": 1.25e-6, "worse": 1.5e-6},
                "largest_rad": {"value": 5e-6, "sigmas": {"alpha": 2.5}},
            },
            {
                "index": "PDE",
                "window_s": 0.5,
                "spacing_s": 8.0,
                "nominal_rad": 2.5e-6,
                "drawn_rad": {"median": 2.75e-6, "worse": 3.125e-6},
                "largest_rad": {"value": 4.5e-6, "sigmas": {"alpha": -1.25}},
            },
        ],
        "verified_in_time": {
            "pole": 0.987654,
            "linear": "settles",
            "with_hysteresis": "grows",
            "seconds": 0.125,
            "offset_rad": 3e-6,
            "theory": "settles",
            "agrees": False,
        },
    }


def test_the_setting_of_a_loop_of_several_axes_has_its_counts_times_and_the_disturbances_of_the_first():
    loop = ns(
        timing=ns(period_s=1e-3, delay_steps=3, step_s=5e-5),
        optical=ns(noise_rad=2.5e-7),
        disturbances=[
            [ns(name="body", rms_rad=2e-6), ns(name="wheels", rms_rad=1.25e-6)],
            [ns(name="x", rms_rad=9e-6)],
        ],
        mirror=ns(name="tripod", actuators=3, axes=2, A=np.zeros((5, 5)), bank=[None] * 4),
    )
    table = ns(runs=7, duration_s=20.0, settle_s=0.5, seed=11, modulus_margin=0.55)
    assert section.setting(ns(scene=ns(loop=loop, table=table))) == (
        "Mirror of several axes: tripod, 3 actuators, 2 outputs, 5 states, 4 hysteresis elements. Control at 1 kHz "
        "with 150 µs of delay, sensor noise 250 nrad rms per axis and reading; disturbances, rms per axis before the "
        "loop: body 2.00 µrad and wheels 1.25 µrad. Simulated: 7 runs of 20 s each, the first 500 ms left out, seed "
        "11. A design has to keep a modulus margin of 0.55."
    )


def design_of(k):
    """A controller whose margins are seven numbers of its own."""
    names = ("modulus", "gain_up", "phase_rad", "delay_s", "disk", "bandwidth_hz", "crossover_hz")
    return SimpleNamespace(
        name=f"controller {k}", loop_margins=SimpleNamespace(**{name: 10.0**n + k for n, name in enumerate(names)})
    )


def residual_of(n, **shares):
    axis = np.array([n + 0.25, n + 0.75])
    met = {"saturated samples": 0.125 * n} | shares
    return SimpleNamespace(
        rms_rad=1.0 * n,
        rms_interval_rad=0.1 * n,
        quantile_rad=2.0 * n,
        largest_rad=3.0 * n,
        axis_rms_rad=axis,
        shares=met,
    )


def test_arrays_of_three_controllers_of_unlike_sources_and_mirrors_have_each_number_in_its_own_place():
    """The second and the third controller ran on a mirror that the first did not, and know another source of error."""
    simulated = [
        {"given": residual_of(1)},
        {"stiff": residual_of(2), "given": residual_of(3)},
        {"stiff": residual_of(4)},
    ]
    known = [
        {"wind": [1.0, 8.0], "noise": [0.0, 4.0]},
        {"gauge": [9.0, 16.0], "noise": [2.0, 2.0]},
        {"gauge": [0.0, 1.0]},
    ]
    freq, spectrum = np.array([1.0, 10.0, 100.0, 1000.0]), np.arange(8.0).reshape(4, 2)
    verified = [
        SimpleNamespace(
            design=design_of(k),
            simulated=simulated[k],
            theory=SimpleNamespace(error_by_source=known[k], radial_rms_rad=0.5 + k),
            spectrum_rad2_hz=spectrum + 100.0 * k,
            predicted_rad2_hz=spectrum + 100.0 * k + 0.5,
        )
        for k in range(3)
    ]
    fine = SimpleNamespace(
        verified=verified,
        scene=SimpleNamespace(loop=SimpleNamespace(axes=2)),
        quantile=0.95,
        best=verified[1],
        optimum_rad=0.375,
        freq_hz=freq,
        disturbed_rad2_hz=freq + 7.0,
    )
    spectra, residuals, theory, loop_margins = (
        make(fine) for make in (arrays._spectra, arrays._residuals, arrays._theory, arrays._loop_margins)
    )
    names = ["controller 0", "controller 1", "controller 2"]
    for group in (spectra, residuals, theory, loop_margins):
        assert group.coordinates["controller"].values.tolist() == names
    for key, more in (("residual", 0.0), ("predicted", 0.5)):
        assert spectra.variables[key].dims == ("controller", "frequency", "axis")
        assert_array_equal(spectra.variables[key].values, [spectrum + 100.0 * k + more for k in range(3)])
    assert_array_equal(spectra.variables["before"].values, freq + 7.0)
    assert_array_equal(spectra.coordinates["frequency"].values, freq)
    assert residuals.attributes == {"quantile": 0.95, "best": "controller 1"}
    assert residuals.coordinates["mirror"].values.tolist() == ["given", "stiff"]
    n = np.array([[1.0, np.nan], [3.0, 2.0], [np.nan, 4.0]])
    of = residuals.variables
    for key, factor in (("rms", 1.0), ("rms_interval", 0.1), ("quantile", 2.0), ("largest", 3.0)):
        assert_allclose(of[key].values, factor * n)
    assert_array_equal(of["axis_rms"].values, n[:, :, None] + [0.25, 0.75])
    assert_array_equal(of["share"].values[:, :, 0], 0.125 * n)
    assert_array_equal(of["share"].values[:, :, 1:], np.where(np.isnan(n), np.nan, 0.0)[:, :, None] * np.ones(5))
    assert theory.coordinates["source"].values.tolist() == ["wind", "noise", "gauge"]
    none = np.nan
    assert_array_equal(
        theory.variables["rms_by_source"].values, [[3.0, 2.0, none], [none, 2.0, 5.0], [none, none, 1.0]]
    )
    assert (theory.variables["rms"].values.tolist(), float(theory.variables["bound"].values)) == (
        [0.5, 1.5, 2.5],
        0.375,
    )
    for power, key in enumerate(
        ("modulus", "gain_up_db", "phase_rad", "delay_s", "disk", "bandwidth_hz", "crossover_hz")
    ):
        values = 10.0**power + np.arange(3.0)
        assert_allclose(loop_margins.variables[key].values, 20.0 * np.log10(values) if power == 1 else values)


def test_arrays_of_the_loops_budget_and_sines_have_unlike_numbers_of_each_kind():
    parts = [
        SimpleNamespace(name=f"part {k}", rms_rad=1.0 + k, theory_rad=None if k == 1 else 5.0 + k) for k in range(3)
    ]
    left_out = [SimpleNamespace(name=f"without {k}", with_rad=20.0 + k, without_rad=10.0 + k) for k in range(2)]
    budget = SimpleNamespace(
        parts=parts, differences=left_out, combined_rad=0.25, together_rad=0.5, full_rad=0.75, controller="PI"
    )
    sines = [
        SimpleNamespace(controller=f"c{k}", variant=f"m{k}", freq_hz=10.0 * k, rms_rad=1.0 + k, quantile_rad=2.0 + k)
        for k in range(4)
    ]
    fine = SimpleNamespace(budget=budget, sines=sines, quantile=0.95)
    found, of = arrays._error_budget(fine), arrays._sines(fine)
    assert found.attributes == {"controller": "PI"}
    assert found.coordinates["part"].values.tolist() == ["part 0", "part 1", "part 2"]
    assert found.coordinates["left_out"].values.tolist() == ["without 0", "without 1"]
    values = {name: variable.values for name, variable in found.variables.items()}
    assert_array_equal(values.pop("theory"), [5.0, np.nan, 7.0])
    assert {name: each.tolist() for name, each in values.items()} == {
        "rms": [1.0, 2.0, 3.0],
        "combined": 0.25,
        "together": 0.5,
        "full": 0.75,
        "with": [20.0, 21.0],
        "without": [10.0, 11.0],
    }
    assert {name: variable.values.tolist() for name, variable in of.variables.items()} == {
        "controller": ["c0", "c1", "c2", "c3"],
        "mirror": ["m0", "m1", "m2", "m3"],
        "frequency": [0.0, 10.0, 20.0, 30.0],
        "rms": [1.0, 2.0, 3.0, 4.0],
        "quantile": [2.0, 3.0, 4.0, 5.0],
    }
    assert of.variables["quantile"].long_name == "radial error that 0.95 of the time stays below"


def test_what_contradicts_linear_theory_is_told_of_each_controller_with_its_own_numbers():
    """Of three controllers the second is as in theory on a straight mirror, and the last was not simulated on one."""
    every = (
        verified("PI", 2e-6, 4e-6, **{"no hysteresis": (3e-6, 1e-6)}),
        verified("LQG", 1.25e-6, 3e-6, **{"no hysteresis": (1.25e-6, 1e-6)}),
        verified("PID", 5e-6, 7e-6),
        verified("H-inf", 4e-6, 6e-6, **{"no hysteresis": (2e-6, 1e-6)}),
    )
    fine = loops_of(1.5e-6, *every)
    fine.budget = ns(linear=False, controller="PID", combined_rad=2.5e-6, full_rad=6.25e-6)
    act = "in theory: its limits or quantisation act"
    assert words._theory_warnings(fine) == [
        (
            ["PID"],
            "the error budget of PID is not linear: its parts combine to 2.50 µrad, the whole is 6.25 µrad rms",
        ),
        (["PI"], f"PI leaves 3.00 µrad rms without hysteresis, 2.00 µrad {act}"),
        (["H-inf"], f"H-inf leaves 2.00 µrad rms without hysteresis, 4.00 µrad {act}"),
        (["LQG"], "the linear bound of 1.50 µrad rms lies above the 1.25 µrad of LQG, so it is none"),
    ]
    fine = loops_of(1e-6, every[1])
    fine.budget = ns(linear=True)
    assert words._theory_warnings(fine) == []


def test_a_bound_above_all_that_is_left_leaves_nothing_to_gain():
    found = words.room(loops_of(5.0, verified("PI", 2.0, 4.0), verified("LQG", 1.0, 6.0)))
    assert (found.at_baseline, found.at_nearest, found.with_hysteresis) == (0.0, 0.0, 0.0)
    assert (found.gained, found.holds) == (pytest.approx(-0.5), False)


def test_a_sine_that_not_every_controller_ran_is_tracked_by_all_of_those_that_did():
    def sine(controller, freq_hz, quantile_rad):
        return ns(controller=controller, freq_hz=freq_hz, quantile_rad=quantile_rad, variant="given")

    sines = [sine("PI", 1.0, 1e-6), sine("LQG", 1.0, 2e-6), sine("LQG", 2.0, 3e-6), sine("PI", 5.0, 9e-6)]
    said = words.tracked(ns(sines=sines, verified=range(2)), 5e-6)
    assert said.endswith(
        "the requirement is met at 1 Hz by all controllers; at 2 Hz by all controllers; at 5 Hz by none (least: 9.00 "
        "µrad, PI)."
    )


def test_a_rational_form_that_leaves_nothing_is_0_in_the_data_and_one_that_is_not_known_is_none():
    errors = [
        ns(index=ErrorIndex("MPE", 2.0), left={"a": 3e-6, "b": 4e-6}, before={"a": 6e-6, "b": 8e-6}, rational=value)
        for value in (0.0, math.nan, 2e-6)
    ]
    found = windows.windows_data(errors)
    assert [each["without_the_loop_rational_rad"] for each in found] == [0.0, None, 2e-6]
    assert found[0]["left_rad"] == {"a": 3e-6, "b": 4e-6, "all": pytest.approx(5e-6)}
    assert found[0]["without_the_loop_rad"]["all"] == pytest.approx(1e-5)


def test_the_data_of_the_angle_of_arrival_are_those_of_the_first_axis():
    def loop(*axes):
        return ns(loop=ns(disturbances=axes))

    def arriving(rms_rad):
        return ns(name="angle of arrival", rms_rad=rms_rad, basis=f"of {rms_rad}", source="a paper")

    other = ns(name="OLYMPUS", rms_rad=1.0, basis="b", source="c")
    found = plain_data.arrival(loop((other, arriving(2e-6)), (arriving(3e-6),)))
    assert found == {"angle_of_arrival": {"rms_rad": 2e-6, "basis": "of 2e-06", "source": "a paper"}}
    assert plain_data.arrival(loop((other,), (arriving(3e-6),))) == {}


def test_the_best_controller_is_drawn_before_an_inverse_in_series_and_each_has_a_look_of_its_own():
    def controller(name, rms_rad, inverse=""):
        return ns(design=ns(name=name, inverse=inverse), theory=ns(radial_rms_rad=rms_rad))

    first, series, best, lowest = (
        *(controller("PI", 9.0), controller("series", 8.0, "in series")),
        *(controller("best", 7.0, "in the loop"), controller("lowest", 1.0)),
    )
    found = figures.shown(ns(verified=(first, series, best, lowest), best=best))
    assert [each.name for each in found] == ["PI", "best", "series"]
    assert [each.marker for each in found] == ["o", "s", "^"] and len({each.colour for each in found}) == 3
    found = figures.shown(ns(verified=(first, best, lowest), best=first))
    assert [each.name for each in found] == ["PI", "lowest", "best"]


def test_margins_of_designs_are_named_behind_the_columns_that_stand_between():
    cells = ("a", "0.50", "6.0", "40", "", "0.9", "10", "", "b")
    _, table, _ = section.designs([("PI", "1", "2", *cells), ("LQG", "3", "4", *cells)], "", ("one", "two"), (1,))
    headings = list(table.headings)
    assert headings == [
        *("controller", "one", "two", "tuned to", "modulus", "gain (dB)", "phase (°)", "disk", "bandwidth (Hz)"),
        "bound by",
    ]
    assert {headings[place]: name for place, name in table.names.items()} == {
        heading: f"controllers.margins.{name}"
        for heading, name in (
            *(("modulus", "modulus"), ("gain (dB)", "gain_up_db"), ("phase (°)", "phase_rad"), ("disk", "disk")),
            ("bandwidth (Hz)", "bandwidth_hz"),
        )
    }
    assert [headings[place] for place in table.words] == ["controller", "tuned to", "bound by"]
