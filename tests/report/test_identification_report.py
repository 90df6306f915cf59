"""The report of an identification: whole or absent, self-contained, its numbers those of the record."""

import html
import json
import math
import os
import re
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.signal import cont2discrete, lfilter, welch

from drawn import figure_of, lines_of, one_text, outline
from drawn import plain as rounded_numbers
from microrad import report
from microrad.core.kernels import play_response
from microrad.core.units import format_quantity
from microrad.lab.identify import BoucWenFit, PrandtlIshlinskiiFit, Refused, identify, mirror_file_text
from microrad.lab.identify.selection.roles import Roles
from microrad.lab.identify.statistics import rounded_to_error
from microrad.lab.recording import Finding, recording_from_arrays
from microrad.mirror.hysteresis import BoucWen
from microrad.report.identification import data as identification_numbers
from microrad.report.identification import figures, parameters, words
from microrad.report.identification import page as identification_page
from microrad.report.identification import terminal as identification_terminal
from microrad.report.identification.figures import identification_figures
from microrad.report.identification.page import BEGINS
from microrad.report.identification.parameters import (
    ParameterRow,
    not_identified,
    parameter_rows,
    starts_text,
    two_digits,
)
from microrad.report.plotting.interactive import plot_of
from microrad.report.plotting.palette import BLUE, MOST_POINTS, ORANGE, SKY, VERMILION
from microrad.report.plotting.sheet import Line, Panel, Span
from microrad.report.tables import Table
from report_pages import assert_sound, without_scripts

RATE_HZ = 2000.0
HOSTILE = "<script>alert(1)</script> $x_^2$ .csv"
SECTIONS = (
    "Warnings and refusals",
    "Recordings",
    "Linear part",
    "Loops",
    "Time response",
    "Residuals",
    "Parameters",
    "All models",
    "Mirror file and origin",
)


def philox(seed):
    return np.random.Generator(np.random.Philox(seed))


def behind_resonance(drive):
    """A second-order system of gain 1 at 150 Hz, damping 0.3, behind a zero-order hold, from rest at the start."""
    w = 2 * np.pi * 150.0
    b, a, _ = cont2discrete(([w * w], [1.0, 2 * 0.3 * w, w * w]), 1 / RATE_HZ)
    return lfilter(b.ravel(), a, drive - drive[0])


def loop(freq_hz, seed, name, seconds=0.3):
    """Two play operators behind the resonance, mrad over V, noise of 0.2 % of the peak-to-peak."""
    drive = 6 - 6 * np.cos(2 * np.pi * freq_hz * np.arange(round(seconds * RATE_HZ)) / RATE_HZ)
    play = play_response(drive, np.array([0.0, 1.0]), np.full(2, drive[0])) @ np.array([0.06, 0.03])
    output = behind_resonance(play)
    output = output + 0.002 * np.ptp(output) * philox(seed).standard_normal(output.size)
    return recording_from_arrays(drive, output, RATE_HZ, name)


def chirp(seed=9, seconds=4.0):
    """A small logarithmic chirp from 1 Hz to 600 Hz behind the same resonance."""
    t = np.arange(round(seconds * RATE_HZ)) / RATE_HZ
    drive = 0.2 * np.sin(2 * np.pi * seconds / math.log(600.0) * (600.0 ** (t / seconds) - 1))
    output = 0.07 * behind_resonance(drive)
    output = output + 0.01 * np.std(output) * philox(seed).standard_normal(output.size)
    return recording_from_arrays(drive, output, RATE_HZ, "chirp.csv")


@pytest.fixture(scope="module")
def static():
    """One loop and the static play operators alone."""
    return identify([loop(4.0, 1, HOSTILE, 1.0)], models=("prandtl_ishlinskii",))


@pytest.fixture(scope="module")
def recordings():
    return [loop(15.0, 1, "15.csv"), loop(20.0, 2, "20.csv"), loop(25.0, 3, "25.csv"), chirp()]


@pytest.fixture(scope="module")
def full(recordings):
    """Loops and a chirp: a linear part, a joint model, refusals, and a recording for validation."""
    models = ("prandtl_ishlinskii", "bouc_wen", "linear")
    found = identify(recordings, 0.5, models=models, validation=[loop(17.5, 4, "17.csv")])
    return replace(found, refused=(Refused("prandtl_ishlinskii_creep", "the longest recording lasts <1 s"),))


@pytest.fixture(scope="module")
def page(full, recordings, tmp_path_factory):
    return write(full, tmp_path_factory.mktemp("report") / "found.html", recordings=recordings)


def write(found, target, **options):
    given = {"mirror_file": Path("lab-mirror.toml"), "mirror_text": mirror_file_text(found, "lab"), "title": "A mirror"}
    return report.write_identification(found, target, **given | options)


@pytest.fixture
def no_figures(monkeypatch):
    """Drawing has tests of its own and takes the longest."""
    monkeypatch.setattr(identification_page, "identification_figures", lambda *args, **kwargs: {})


def text_of(path):
    return path.read_text(encoding="utf-8")


def rows_of(text):
    """The cells of each table row of a page, as plain text."""
    found = []
    for row in re.findall(r"<tr[^>]*>(.*?)</tr>", text, re.DOTALL):
        cells = re.findall(r"<t[dh][^>]*>(.*?)</t[dh]>", row, re.DOTALL)
        found.append([html.unescape(re.sub(r"<[^>]*>", "", cell)).strip() for cell in cells])
    return found


def without_tags(text):
    return " ".join(html.unescape(re.sub(r"<[^>]*>", "", text)).split())


def row_of(text, first):
    rows = [row for row in rows_of(text) if row and row[0] == first]
    assert len(rows) == 1, (first, rows)
    return rows[0]


# --------------------------------------------------------------------------------------------------------- the page
class Links(HTMLParser):
    """Everything a page would load or link to."""

    def __init__(self):
        super().__init__()
        self.found, self.scripts = [], 0

    def handle_starttag(self, tag, attrs):
        self.scripts += tag == "script"
        names = {"src", "href", "xlink:href", "data", "action", "poster", "srcset"}
        self.found += [value for name, value in attrs if name in names]


def test_the_page_loads_nothing_and_has_its_sections_in_order(page, full):
    text = without_scripts(text_of(page))
    assert_sound(text)
    links = Links()
    links.feed(text)
    assert [link for link in links.found if not link.startswith("#")] == []
    assert links.scripts == 0
    assert "@import" not in text
    assert not re.search(r"url\((?!#)", text)
    assert re.findall(r"<h2 [^>]*>([^<]*)<a ", text) == list(SECTIONS)
    assert 0 < text.index(words.verdict(full)[0]) < text.index("<h2 ")
    assert "nan" not in re.sub(r"<[^>]*>", " ", text).split()
    assert page.stat().st_size < 3e6


@pytest.mark.promise("report-12")
def test_every_figure_stands_in_its_section(page):
    text = text_of(page)
    parts = dict(zip(SECTIONS, re.split(r"<h2 .*?</h2>", text)[1:], strict=True))
    counted = {name: part.count("<figure") for name, part in parts.items() if "<figure" in part}
    assert counted == {"Recordings": 1, "Linear part": 2, "Loops": 1, "Time response": 1, "Residuals": 2}


@pytest.mark.promise("readme-9")
def test_the_ranking_holds_the_numbers_of_the_scores(page, full):
    text = text_of(page)
    for score in (*full.scores, full.straight_line):
        chosen = " (chosen)" if score.model == full.chosen else ""
        row = row_of(text, score.model + chosen)
        assert [float(cell) for cell in row[1:5]] == [
            pytest.approx(score.fit_rms_percent, abs=5.1e-4),
            pytest.approx(score.fit_peak_percent, abs=5.1e-3),
            pytest.approx(score.held_out_rms_percent, abs=5.1e-4),
            pytest.approx(score.held_out_peak_percent, abs=5.1e-3),
        ]
        rms_urad = 1e6 * score.held_out_rms_percent / 100 * full.span_rad
        assert row[5] == f"{rms_urad:.3g} µrad"
    listed = [
        row[0].removesuffix(" (chosen)") for row in rows_of(text) if len(row) == 7 and row[6] in ("yes", "no", "")
    ]
    listed = [name for name in listed if name in {s.model for s in full.scores} | {"straight line"}]
    assert listed == [s.model for s in sorted((*full.scores, full.straight_line), key=lambda s: s.held_out_rms_percent)]


@pytest.mark.promise("gallery-7")
def test_the_parameter_table_holds_value_and_error_of_every_model(page, full):
    text = text_of(page)
    for score, fit in zip(full.scores, full.fits, strict=True):
        part = text[text.index(f"{score.model}", text.index(">Parameters<a")) :]
        rows = rows_of(part[: part.index("</table>")])[1:]
        expected = parameter_rows(fit)
        assert len(rows) == len(expected) > 0
        for cells, row in zip(rows, expected, strict=True):
            value, error, unit = row.shown
            shown = re.sub("^-", "\u2212", rounded_to_error(value, error))
            assert cells[:4] == [row.name, shown, two_digits(error), unit]
        for name, why in not_identified(fit):
            assert any(cells[0] == name and why in cells[4] for cells in rows)
        below = part[part.index("</table>") :][:2000]
        assert starts_text(fit)[1:] in below


def test_where_a_search_began_is_told(full):
    held = full.fit("linear")
    assert starts_text(held) == "one start was made, from the least-squares weights of the operators"
    assert starts_text(replace(held, begun=True)) == "one start was made, from an earlier fit of the same model"
    searched = full.fit("bouc_wen")
    assert starts_text(searched) == f"{searched.agreeing_starts} of 12 starts reached the best fit"
    assert "no starts are needed" in starts_text(full.fit("prandtl_ishlinskii"))


def test_parameters_are_shown_in_their_units(page, full):
    fit, part = full.fit("bouc_wen"), text_of(page)
    rows = rows_of(part[part.index("bouc_wen", part.index(">Parameters<a")) :])
    d1, alpha = (next(row for row in rows if row[0] == name) for name in ("d1", "alpha"))
    errors = fit.standard_errors
    shown = rounded_to_error(1e3 * fit.model.d1_rad_v, 1e3 * errors[0])
    assert d1[1:4] == [shown, f"{float(f'{1e3 * errors[0]:.2g}'):g}", "mrad/V"]
    shown = rounded_to_error(fit.model.alpha_1_v, errors[4])
    assert alpha[1:4] == [shown, f"{float(f'{errors[4]:.2g}'):g}", "1/V"]


def test_poles_order_and_gains_are_those_of_the_linear_fit(page, full):
    text, linear = text_of(page), full.linear
    upper = linear.poles_rad_s[np.argmax(linear.poles_rad_s.imag)]
    assert abs(upper) / (2 * np.pi) == pytest.approx(150.0, rel=0.01)
    error = linear.poles_error_rad_s[np.argmax(linear.poles_rad_s.imag)]
    assert row_of(text, "pole pair")[1] == f"{rounded_to_error(abs(upper) / (2 * np.pi), error / (2 * np.pi))} Hz"
    assert row_of(text, "pole pair")[3] == rounded_to_error(-upper.real / abs(upper), error / abs(upper))
    gain = rounded_to_error(1e3 * linear.dc_gain[0, 0], 1e3 * linear.dc_gain_error[0, 0])
    assert row_of(text, "gain at zero frequency")[1] == f"{gain} mrad/V"
    edge = row_of(text, f"gain at {linear.excited_hz[0]:.3g} Hz")
    assert edge[1:3] == [
        f"{rounded_to_error(1e3 * linear.edge_gain[0, 0], 1e3 * linear.edge_gain_error[0, 0])} mrad/V",
        f"{1e3 * linear.edge_gain_error[0, 0]:.2g} mrad/V",
    ]
    assert row_of(text, "gain at zero frequency")[5:] == ["no", "extrapolated"]
    assert edge[5:] == ["yes", ""]
    for score in linear.scan:
        row = next(r for r in rows_of(text) if len(r) == 6 and r[:2] == [str(score.order), str(score.parameters)])
        assert row[5] == ("chosen" if score.order == linear.order else "")
    assert html.unescape(text).count(linear.reason[1:]) == 1


def test_recordings_have_their_roles_hashes_and_findings(full, recordings, no_figures, tmp_path):
    noticed = replace(recordings[0], findings=(Finding("drift", "angle", None, "it drifts by <1 %", True),))
    found = replace(full, recordings=(noticed, *full.recordings[1:]))
    text = text_of(write(found, tmp_path / "r.html", recordings=recordings))
    files = {row[0]: row[1:] for row in rows_of(text) if len(row) == 7 and row[0].endswith(".csv")}
    assert {name: cells[0] for name, cells in files.items()} == {
        "15.csv": "loops",
        "20.csv": "loops",
        "25.csv": "loops",
        "chirp.csv": "broadband",
        "17.csv": "validation",
    }
    assert files["15.csv"][1:] == ["15 Hz, ± 6 V about 6 V", "2 kHz", "300", "300", "300 ms"]
    assert files["chirp.csv"][1:] == ["many frequencies, ± 0.2 V about 0 V", "2 kHz", "8000", "0", "4 s"]
    for source in full.sources:
        assert source.sha256 in text
    assert "drift (accepted): it drifts by &lt;1 %" in text
    assert "noticed nothing" not in text
    clean = replace(full, recordings=tuple(replace(r, findings=()) for r in full.recordings))
    assert "noticed nothing" in text_of(write(clean, tmp_path / "s.html"))


@pytest.mark.promise("readme-9")
def test_refused_models_and_warnings_stand_before_the_numbers(page, full):
    text = html.unescape(text_of(page))
    assert [r.model for r in full.refused] == ["prandtl_ishlinskii_creep"]
    for said in (*full.warnings, full.refused[0].reason):
        assert text.index("Warnings and refusals") < text.index(said) < text.index(">Recordings<a")


def test_a_page_without_linear_part_says_why(static, tmp_path):
    text = text_of(write(static, tmp_path / "r.html"))
    assert re.findall(r"<h2 [^>]*>([^<]*)<a ", text) == list(SECTIONS)
    assert "No recording is broadband" in text
    assert text.count("<figure") == 4


# ------------------------------------------------------------------------------------------------------ the figures
def test_every_axis_has_a_label_with_its_unit(full, recordings):
    drawn = identification_figures(full, recordings)
    for figure in drawn.values():
        for panel in figure.sheet.panels:
            assert re.fullmatch(r"[a-z ]+ \([^()]+\)", panel.y.title), (figure.title, panel.y.title)
            if not figure.sheet.share_x or panel is figure.sheet.panels[-1]:
                assert re.fullmatch(r"[a-z ]+ \([^()]+\)", panel.x.title), figure.title
            assert any(line.x.size for line in panel.all_of(Line)), figure.title
    assert len(drawn["excitation"].sheet.panels) == 2 * len(figures.shown(full, recordings)) == 10


@pytest.mark.promise("gallery-8")
def test_loops_show_measured_and_modelled_output_and_the_hysteresis(full, recordings):
    drawing = figures.loops(figures.shown(full, recordings), full)
    left, right = drawing.sheet.panels[:2]
    p = words.chosen_predictions(full)[0]
    lines = left.all_of(Line)
    measured, unseen, model = lines[0], lines[1], lines[-1]
    assert [line.colour for line in (measured, unseen, model)] == [SKY, BLUE, VERMILION]
    assert [line.label for line in (measured, unseen, model)] == [
        "measured, fitted",
        "measured, unseen by the fit",
        "modelled",
    ]
    period = math.ceil(RATE_HZ / 15.0) + 1
    assert unseen.x.size == pytest.approx(period, abs=1)
    np.testing.assert_array_equal(unseen.x, full.recordings[0].drive[-unseen.x.size :, 0])
    moved = 1e3 * (p.measured_rad - p.model_rad)[-period:]
    np.testing.assert_allclose(unseen.y - model.y, moved, atol=1e-12)
    assert np.ptp(right.all_of(Line)[1].y) / 1e3 < 0.5 * np.ptp(unseen.y)
    missed_urad = math.sqrt(np.mean((1e6 * (p.measured_rad - p.model_rad)[p.split :]) ** 2))
    assert right.title == f"15 Hz, ± 6 V: unseen {missed_urad:.3g} µrad rms"


def test_figures_are_those_of_the_users_mirror_and_not_the_papers(full, recordings):
    drawn = identification_figures(full, recordings)
    assert list(drawn) == ["excitation", "response", "poles", "loops", "time", "residuals", "tests"]
    assert drawn["loops"].title == "Loops, measured against modelled"
    assert drawn["time"].title == f"Time response to the chirp, fit {full.linear.fit_percent[0]:.2f} %"
    assert "measured less modelled" in drawn["time"].svg
    for figure in drawn.values():
        assert not re.search(r"Fig\. \d|virtual bench", figure.title + figure.caption + figure.svg)
    assert figures.time_response(full, []) is None


def test_the_virtual_bench_is_named_on_the_page_and_in_each_figure(static, tmp_path):
    text = text_of(write(static, tmp_path / "virtual.html", virtual=True))
    for part in re.findall(r"<figure.*?</figure>", text, re.DOTALL):
        assert "(virtual bench)</title>" not in part
        assert part.count("virtual bench") >= 3  # label of the group, the picture itself, its caption
    assert '<span class="badge">virtual bench</span>' in text
    assert "virtual bench" not in text_of(write(static, tmp_path / "real.html"))


def test_long_records_are_drawn_small_and_keep_their_peaks(static):
    shown = figures.shown(static, [])[0]
    n = 400_000
    residual = np.zeros(n)
    residual[123_457] = 5e-6
    prediction = replace(shown.prediction, measured_rad=residual, model_rad=np.zeros(n), start=10, split=n // 2)
    drawing = figures.residuals([replace(shown, drive_v=np.arange(n) / n, prediction=prediction)])
    curves = [trace for trace in plot_of(drawing.sheet)["data"] if trace["mode"] == "lines"]
    assert [trace["name"] for trace in curves] == ["fitted", "unseen"]
    assert all(0 < len(trace["x"]) <= MOST_POINTS for trace in curves)
    assert [max(trace["y"]) for trace in curves] == [pytest.approx(5.0), 0.0]
    assert len(drawing.svg) < 60_000


def test_only_some_of_many_recordings_are_drawn_and_the_caption_says_so(static):
    shown = figures.shown(static, [])[0]
    many = figures.residuals([shown] * (figures.MOST_RECORDINGS + 3))
    assert len(many.sheet.panels) == figures.MOST_RECORDINGS
    assert "3 more recordings are not drawn" in many.caption
    three = figures.residuals([shown] * 3)
    assert "not drawn" not in three.caption
    assert len(three.sheet.panels) == 3  # the fourth place stays empty


def test_a_drive_at_rest_has_a_spectrum_without_lines(static):
    moving = figures.shown(static, [])[0]
    for one, lines in ((moving, True), (replace(moving, drive_v=np.full(500, 3.0)), False)):
        drawn = figures.excitation([one], static)
        assert bool(drawn.sheet.panels[1].all_of(Line)[0].x.size) == lines
        assert "amplitude (V)" in drawn.svg
        assert "amplitude" in drawn.plot


def test_the_spectrum_shows_amplitudes_and_a_chirp_is_told_from_noise():
    t = np.arange(2000) / 1000.0
    freq, amplitude = figures.amplitude_spectrum(3 + 2 * np.sin(2 * np.pi * 50 * t), 1000.0)
    assert freq[np.argmax(amplitude)] == pytest.approx(50.0)
    assert amplitude.max() == pytest.approx(2.0, rel=1e-9)
    long = figures.amplitude_spectrum(philox(1).standard_normal(600_000), 1000.0)[0]
    assert 300 < long.size <= MOST_POINTS // 3  # each stroke has three points, and none is left out
    assert figures.is_chirp(chirp())
    noise = philox(0).standard_normal(4000)
    assert not figures.is_chirp(recording_from_arrays(noise, noise, RATE_HZ, "noise"))


def test_the_frequency_of_a_drive():
    t = np.arange(5000) / 5000.0
    plain, growing = words.sine_of(6 + 3 * np.sin(2 * np.pi * 40 * t), 5000.0), None
    growing = words.sine_of(6 + np.ceil(3 * t) * np.sin(2 * np.pi * 42 * t), 5000.0)
    assert (plain.freq_hz, plain.amplitude_v) == (pytest.approx(40, rel=1e-3), pytest.approx(3, rel=1e-3))
    assert (growing.freq_hz, growing.amplitude_v) == (pytest.approx(42, rel=1e-2), pytest.approx(3, rel=1e-2))
    assert words.sine_of(philox(1).standard_normal(5000), 5000.0) is None
    assert words.sine_of(np.repeat([0.0, 6.0, 12.0, 6.0, 0.0], 1000), 5000.0) is None


# ------------------------------------------------------------------------------------------------ hostile and broken
def test_names_and_titles_are_escaped(static, tmp_path):
    text = without_scripts(text_of(write(static, tmp_path / "r.html", title=HOSTILE, mirror_file=Path(HOSTILE))))
    assert "<script" not in text
    assert text.count("&lt;script&gt;") >= 4
    assert "$x_^2$" in text


def test_a_file_of_another_is_left_alone(static, no_figures, tmp_path):
    mine = tmp_path / "notes.html"
    mine.write_text("<!DOCTYPE html>\n<html lang='en'>mine", encoding="utf-8")
    for overwrite in (False, True):
        with pytest.raises(report.ReportError, match=r"notes\.html is not a report that microrad identify wrote"):
            write(static, mine, overwrite=overwrite)
    assert text_of(mine).endswith("mine")
    with pytest.raises(report.ReportError, match="is not a report that microrad"):
        write(static, tmp_path, overwrite=True)
    with pytest.raises(report.ReportError, match=r"there is no folder .*nowhere; create it first"):
        write(static, tmp_path / "nowhere" / "r.html")
    assert [p.name for p in tmp_path.iterdir()] == ["notes.html"]


def test_an_older_report_is_replaced_only_when_told(static, no_figures, tmp_path):
    target = tmp_path / "r.html"
    target.write_text(BEGINS + "old", encoding="utf-8")
    with pytest.raises(report.ReportError, match="replace it with --overwrite"):
        write(static, target)
    assert text_of(target).endswith("old")
    assert write(static, target, overwrite=True) == target
    assert text_of(target).startswith(BEGINS)
    assert text_of(target).rstrip().endswith("</html>")
    assert [p.name for p in tmp_path.iterdir()] == ["r.html"]


@pytest.mark.parametrize("error", [KeyboardInterrupt, OSError(28, "No space left on device"), MemoryError])
def test_an_interrupted_write_leaves_nothing_and_keeps_the_old(static, no_figures, tmp_path, monkeypatch, error):
    target = tmp_path / "r.html"
    target.write_text(BEGINS + "old", encoding="utf-8")

    def fails(descriptor):
        raise error

    monkeypatch.setattr(os, "fsync", fails)
    with pytest.raises(BaseException) as caught:
        write(static, target, overwrite=True)
    assert not isinstance(caught.value, report.ReportError)
    assert text_of(target).endswith("old")
    assert [p.name for p in tmp_path.iterdir()] == ["r.html"]


# --------------------------------------------------------------------------------------------------- text and data
def test_a_terminal_has_the_error_what_it_rests_on_poles_warnings_and_what_to_do_next(full, page):
    files = {"mirror_file": Path("a b.toml"), "report_file": Path("r.html")}
    text = report.identification_text(full, "linear", **files)
    said = " ".join(text.split())
    assert full.chosen == "bouc_wen"
    headline, worst, *_ = words.verdict(full, "linear")
    assert said.startswith(f"{headline} {worst} A straight line leaves ")
    assert headline in without_tags(text_of(page))
    assert "The mirror file holds linear as asked, which leaves " in said
    assert "It holds for drives from 0 V to 12 V and rates up to " in said
    assert text.endswith(
        "r.html written: what was found, with pictures.\na b.toml written (linear).\n"
        "Next: microrad run leo-geo.toml --mirror 'a b.toml' --output 'a b-study'"
    )
    dashed = report.identification_text(full, "linear", mirror_file=Path("-m.toml"))
    assert dashed.endswith("Next: microrad run leo-geo.toml --mirror ./-m.toml --output -m-study")
    assert "as asked" not in report.identification_text(full, full.chosen)
    lines = text.splitlines()
    assert len(lines) <= 23
    assert max(map(len, lines)) <= 80
    rows = [row for row in parameter_rows(full.fit("linear")) if row.name.startswith("pole")]
    for row in rows:  # those of the mirror file, once
        assert len(re.findall(rf"(?m)^ {row.name} +{re.escape(row_of(text_of(page), row.name)[1])}( |$)", text)) == 1
    assert " pole" not in report.identification_text(full, "bouc_wen", **files)  # it has none


def test_a_terminal_has_as_many_warnings_as_there_is_room_for_and_says_how_many_are_left(full):
    said = report.identification_text(full, full.chosen)
    first = words.pressing(full, full.chosen)[0]
    assert f"- {first}" in " ".join(said.split())
    assert "Valid for drives" not in said  # the verdict has it
    many = replace(full, warnings=(*full.warnings[:2], *(f"warning {k} " + 70 * "x" for k in range(20))))
    lines = report.identification_text(many, many.chosen).splitlines()
    assert len(lines) in (22, 23)  # of the next one there is room for a line at most
    shown = sum(line.startswith("- warning") for line in lines)
    assert shown > 3
    left = len(words.pressing(many, many.chosen)) - shown
    assert lines[-1] == f"- {left} more warnings and 1 refused model: see the report, or --json."
    none = replace(full, warnings=full.warnings[:2], refused=(), chosen="linear")
    assert "see the report" not in report.identification_text(none, "linear")
    long = replace(none, warnings=(*full.warnings[:2], "word " * 400))
    *_, last, more = report.identification_text(long, "linear").splitlines()
    assert last.endswith("word …")
    assert more == "- the whole of it: see the report, or --json."


def test_the_verdict_says_on_what_it_rests_and_names_the_worst_recording(full):
    headline, worst, *_ = words.verdict(full)
    predictions = words.chosen_predictions(full)
    unseen = sum((r.samples - p.split) / RATE_HZ for r, p in zip(full.recordings, predictions, strict=True))
    assert headline.endswith(f"over {unseen:.3g} s of 4 recordings.")
    residuals = [1e6 * p.residual_rad[p.start :] for p in predictions]
    place = int(np.argmax([np.std(residual) for residual in residuals]))
    rms, peak = float(np.sqrt(np.mean(residuals[place] ** 2))), np.abs(residuals[place]).max()
    share = 1e-4 * rms / full.span_rad
    assert f"fitted or not, is {full.recordings[place].path}, with {rms:.3g} µrad rms ({share:.3g} %)" in worst
    assert worst.endswith(f"and {peak:.3g} µrad at most.")


def test_the_verdict_compares_with_the_papers_model_and_the_line(full, static):
    said = " ".join(words.verdict(full))
    own = full.score().held_out_rms_percent
    line = full.straight_line.held_out_rms_percent
    assert f"a straight line leaves {line * full.span_rad * 1e4:.3g} µrad rms ({line:.3g} %)" in said
    assert f", {line / own:.3g} times as much" in said
    assert "It is the paper's model (Eq. 3)" in said
    other = replace(full, chosen="linear")
    paper = full.score("bouc_wen")
    ratio = paper.held_out_rms_percent / full.score("linear").held_out_rms_percent
    beside = f"The paper's model (bouc_wen) leaves {paper.held_out_rms_percent * full.span_rad * 1e4:.3g} µrad rms"
    assert beside in " ".join(words.verdict(other))
    assert f", {ratio:.3g} times as much, a straight" in " ".join(words.verdict(other))
    assert f"rates up to {format_quantity(full.rate_limit_v_per_s, 'V/s', 4)}" in said
    freq = full.rate_limit_v_per_s / (math.pi * (full.drive_max_v - full.drive_min_v))
    assert f"reaches at {freq:.4g} Hz" in said
    assert "from 0 V to 12 V" in said
    assert "was not fitted" in " ".join(words.verdict(static))
    assert "There is no linear part" in " ".join(words.verdict(static))


def test_the_data_are_json_with_finite_numbers_or_null(full):
    data = report.identification_data(full, full.chosen, mirror_file=Path("m.toml"))
    assert json.loads(json.dumps(data, allow_nan=False)) == data
    assert (data["mirror_file"], data["report_file"]) == ("m.toml", None)
    assert [s["model"] for s in data["scores"]] == [*(s.model for s in full.scores), "straight line"]
    assert data["scores"][0]["held_out_rms_rad"] == full.scores[0].held_out_rms_percent / 100 * full.span_rad
    plays, bouc_wen = data["parameters"]["prandtl_ishlinskii"], data["parameters"]["bouc_wen"]
    assert plays["weights_rad_v"] == full.fit("prandtl_ishlinskii").weights_rad_per_v.tolist()
    held = [e is None for e in plays["standard_errors_rad_v"]]
    assert held == [w == 0 for w in plays["weights_rad_v"]]
    assert any(held)
    assert bouc_wen["d1"] == {
        "value": full.fit("bouc_wen").model.d1_rad_v,
        "standard_error": float(full.fit("bouc_wen").standard_errors[0]),
        "unit": "rad/V",
    }
    assert bouc_wen["starts"] == 12
    assert plays["starts"] is None
    assert data["linear"]["order"] == full.linear.order
    assert data["residual"]["white"] == full.residual.white
    assert data["refused"].keys() == {"prandtl_ishlinskii_creep"}


def test_a_held_number_has_no_error_and_says_why(full):
    rows = {row.name: row for row in parameter_rows(full.fit("linear"))}
    lone = ParameterRow("gain", 2e-3, 1e-4, "rad/V")
    assert lone.shown == (2.0, pytest.approx(0.1), "mrad/V")
    assert math.isfinite(rows["weight at 0 V"].standard_error)
    if full.chosen != "linear":
        assert math.isnan(rows["pole 1"].standard_error)
        assert rows["pole 1"].note == "held, from the frequency response"


def test_an_error_has_two_digits_and_no_needless_exponent():
    assert [two_digits(x) for x in (904.2, 0.01234, 1.0, 3.04e-7)] == ["900", "0.012", "1", "3e-07"]
    assert two_digits(math.nan) == ""


def test_the_report_package_stays_light_to_import():
    import subprocess
    import sys

    code = "import sys, microrad.report; print([m for m in ('contourpy', 'jinja2', 'xarray') if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


@pytest.mark.parametrize(("fitted", "damping", "names"), [
    ((), 0.3, ["pole 1", "pole 1 damping", "zero 1"]),
    ((), -0.3, ["pole 1", "pole 1 damping", "zero 1"]),
    ((), 1.0, ["pole 1", "zero 1"]),
    ((), -1.0, ["pole 1", "zero 1"]),
    (("zero 1",), 0.3, ["pole 1", "pole 1 damping"]),
    (("pole 1",), 0.3, ["zero 1"]),
])  # fmt: skip
def test_a_real_pole_that_was_held_has_no_damping(fitted, damping, names):
    poles = SimpleNamespace(frequencies_hz=[900.0], dampings=[damping])
    zeros = SimpleNamespace(frequencies_hz=[400.0], dampings=[1.0])
    fit = SimpleNamespace(
        structure=SimpleNamespace(parameters=[SimpleNamespace(name=name) for name in fitted]),
        linear=SimpleNamespace(poles=poles, zeros=zeros),
        creep=SimpleNamespace(time_constants_s=[0.5, 7.0]),
    )
    rows = parameters._held(fit)
    assert [row.name for row in rows] == [*names, "creep lag 1", "creep lag 2"]
    values = {"pole 1": (900.0, "Hz"), "pole 1 damping": (damping, ""), "zero 1": (400.0, "Hz")}
    assert [(row.value, row.unit) for row in rows] == [*(values[name] for name in names), (0.5, "s"), (7.0, "s")]
    assert all(math.isnan(row.standard_error) for row in rows)
    assert [row.note for row in rows[-2:]] == ["chosen", "chosen"]
    assert len(parameters._held(SimpleNamespace(**{**vars(fit), "linear": None}))) == 2


@pytest.mark.parametrize(("sources", "said"), [(1, "1 recording, mirror"), (2, "2 recordings, mirror")])
def test_the_page_counts_its_recordings(full, monkeypatch, sources, said):
    monkeypatch.setattr(identification_page, "identification_figures", lambda *args, **more: {})
    monkeypatch.setattr(identification_page, "page_of", lambda title, kind, of, *more, **named: str(of))
    found = replace(full, sources=full.sources[:1] * sources)
    made = identification_page.identification_page(
        found, mirror_file=Path("m.toml"), mirror_text="", title="", written="bouc_wen"
    )
    assert made.startswith(said)


# ----------------------------------------------------------------------------------------------- limits and one or none
def a_recording(counts):
    """A recording whose drive crosses its middle so often in each of its eighths."""
    parts = [np.r_[(-1.0) ** np.arange(count), np.full(40 - count, (-1.0) ** count)] for count in counts]
    drive = np.concatenate(parts)
    return recording_from_arrays(drive, drive, RATE_HZ, "counted")


@pytest.mark.parametrize(
    ("counts", "told"),
    [
        ((1, 1, 2, 3, 4, 4, 5, 6), True),
        ((1, 1, 2, 3, 4, 4, 5, 5), False),
        ((0, 0, 1, 2, 3, 4, 5, 6), True),
        ((0, 0, 1, 2, 3, 4, 5, 5), False),
        ((2, 2, 3, 4, 5, 6, 7, 10), False),
        ((1, 2, 1, 3, 4, 5, 6, 9), False),
    ],
)
def test_a_chirp_crosses_its_middle_ever_more_often_by_more_than_five_times(counts, told):
    recording = a_recording(counts)
    assert figures.is_chirp(recording) is told
    assert figures.is_chirp(replace(recording, period_samples=160)) is False


def test_a_frequency_is_that_of_the_line_where_the_drive_crosses_too_seldom_or_noise_crosses_too():
    t = np.arange(1000) / 1000.0
    two = words.sine_of(np.cos(2 * np.pi * 2 * t - 1.56), 1000.0)  # rises through its middle once
    assert two.freq_hz == pytest.approx(2.0, rel=1e-9)
    ripple = np.sin(2 * np.pi * 40.3 * t) + 0.3 * np.sin(2 * np.pi * 430.0 * t + 0.4)
    assert words.sine_of(ripple, 1000.0).freq_hz == pytest.approx(40.0, rel=1e-9)
    assert words.sine_of(np.sin(2 * np.pi * 40.3 * t), 1000.0).freq_hz == pytest.approx(40.3, rel=1e-4)


@pytest.mark.parametrize(
    ("value", "span", "rounded"),
    [(6.00049, 12.0, 6.0), (6.0051, 12.0, 6.01), (-0.001, 12.0, 0.0), (1.23456, 0.0, 1.23456)],
)
def test_a_voltage_is_told_to_a_thousandth_of_its_range(value, span, rounded):
    found = words._rounded(value, span)
    assert found == pytest.approx(rounded, abs=1e-9)
    assert math.copysign(1.0, found) == 1.0


def score(percent):
    return SimpleNamespace(held_out_rms_percent=percent)


@pytest.mark.parametrize(
    ("own", "line", "admissible", "sound"),
    [(1.0, 2.0, True, True), (2.0, 2.0, True, False), (3.0, 2.0, True, False), (1.0, 2.0, False, False)],
)
def test_a_choice_is_sound_where_it_is_admissible_and_better_than_a_line(own, line, admissible, sound):
    fit = SimpleNamespace(admissible=admissible)
    found = SimpleNamespace(score=lambda: score(own), straight_line=score(line), fit=lambda: fit)
    assert words.sound(found) is sound


def test_an_error_is_compared_where_the_choice_leaves_some():
    for own, said in ((2.0, "200 µrad rms (4 %), 2 times as much"), (0.0, "200 µrad rms (4 %)")):
        assert words._times(score(4.0), SimpleNamespace(score=lambda own=own: score(own), span_rad=5e-3)) == said


def test_why_there_is_no_linear_part_depends_on_the_recordings():
    def said(*roles):
        return words.no_linear(SimpleNamespace(sources=[SimpleNamespace(role=role) for role in roles]))

    assert said("loops", "broadband") == (
        "No model with a linear part was asked for, so the broadband recordings were not used."
    )
    assert said("loops").startswith("No recording is broadband, ")


def test_without_a_linear_part_there_are_no_gains():
    assert words.gains(None) == []


def test_a_name_stays_on_its_line():
    assert words.one_line("a\nb\tc\u2028d é") == "a b c d é"


def a_linear(poles, errors, zeros=()):
    return SimpleNamespace(
        excited_hz=(10.0, 20.0),
        poles_rad_s=2 * np.pi * np.array(poles),
        poles_error_rad_s=2 * np.pi * np.array(errors),
        zeros_rad_s=2 * np.pi * np.array(zeros),
        zeros_error_rad_s=np.zeros(len(zeros)),
        dc_gain=np.array([[1e-3]]),
        dc_gain_error=np.array([[1e-4]]),
        edge_gain=np.array([[2e-3]]),
        edge_gain_error=np.array([[1e-4]]),
    )


def test_roots_are_excited_in_the_band_and_real_ones_have_a_damping_of_1():
    poles = [-9.9 + 0j, -20.1 + 0j, -9.0 + 12.0j, -9.0 - 12.0j]
    linear = a_linear(poles, [0.1, 0.2, 1.5, 1.5], [12.0 + 0j, 0j])
    found = words.roots(linear)
    assert [(r.kind, r.freq_hz, r.damping, r.damping_error, r.excited) for r in found[:3]] == [
        ("pole", pytest.approx(9.9), 1.0, 0.0, False),
        ("pole", pytest.approx(15.0), pytest.approx(0.6), pytest.approx(0.1), True),
        ("pole", pytest.approx(20.1), 1.0, 0.0, False),
    ]
    assert [(r.kind, r.freq_hz, r.excited) for r in found[3:]] == [
        ("zero", 0.0, False),
        ("zero", pytest.approx(12.0), True),
    ]
    assert (found[3].damping, found[3].damping_error, found[4].damping) == (1.0, 0.0, -1.0)
    rows = identification_page._roots(linear).rows
    assert [row[0] for row in rows] == [
        "pole, real",
        "pole pair",
        "pole, real",
        "zero, real",
        "zero, real",
        "gain at zero frequency",
        "gain at 10 Hz",
    ]
    assert [row[4] for row in rows[:3]] == ["", "0.1", ""]
    assert [row[-1] for row in rows] == ["extrapolated", "", "extrapolated", "extrapolated", "", "extrapolated", ""]


def test_a_root_at_no_frequency_is_not_drawn():
    (panel,) = figures.poles(a_linear([-15.0 + 0j], [1.0], [0j])).sheet.panels
    assert [line.label for line in panel.all_of(Line)] == ["poles"]
    assert (panel.x.low, panel.x.high) == (pytest.approx(3.0), pytest.approx(60.0))


def test_a_page_without_warnings_or_orders_says_so(monkeypatch):
    monkeypatch.setattr(words, "fit_warnings", lambda fit: [])
    none = SimpleNamespace(warnings=(), fit=lambda written: None, refused=())
    (points,) = identification_page._warnings(none, "linear").blocks
    assert list(points.lines) == ["No warnings."]
    refused = SimpleNamespace(**{**vars(none), "warnings": ("one",), "refused": [Refused("linear", "short")]})
    said, which, points = identification_page._warnings(refused, "linear").blocks
    assert (list(said.lines), list(points.lines)) == (["one"], ["linear: short"])
    assert which == "Models that these recordings cannot support:"
    assert identification_page._scan(SimpleNamespace(scan=(), order=2)) is None
    order = {"parameters": 5, "chi_square": 12.0, "criterion": 7.0, "output_error_rms": 1e-6}
    scan = [SimpleNamespace(order=k, freedom=3 * k, **order) for k in (0, 2)]
    assert identification_page._scan(SimpleNamespace(scan=scan, order=2)).rows == [
        ("0", "5", "12", "7", "1 µrad", ""),
        ("2", "5", "2", "7", "1 µrad", "chosen"),
    ]


def joint(correlation):
    count = len(correlation)
    return SimpleNamespace(
        fit=SimpleNamespace(correlation=correlation),
        structure=SimpleNamespace(parameters=[SimpleNamespace(name=f"p{k}") for k in range(count)]),
        condition_number=12.0,
        colour_inflation=2.0,
    )


def test_correlated_parameters_are_told_from_the_least_on_the_strongest_first(monkeypatch):
    monkeypatch.setattr(parameters, "starts_text", lambda fit: "one start")
    matrix = np.eye(3)
    matrix[1, 0], matrix[2, 0], matrix[2, 1] = parameters.HIGH_CORRELATION, -0.99, 0.1
    assert parameters.correlations(joint(matrix)) == [("p2", "p0", -0.99), ("p1", "p0", parameters.HIGH_CORRELATION)]
    end = "Condition number 12; the variances are inflated 2 times for the colour of the residual."
    assert parameters.notes(joint(np.eye(3))) == ["One start.", end]
    for count, least, more in ((4, 0, ""), (5, 0, " and 4 pairs more"), (5, 3, " and 1 pair more")):  # six, ten, seven
        matrix = np.full((count, count), 0.999)
        matrix[4:, :least] = 0.0
        _, said, last = parameters.notes(joint(matrix))
        assert said.endswith(f"+0.999{more}.") and said.count(" and p") == 6
        assert last == end


def test_a_long_name_of_a_recording_is_cut_in_its_middle():
    assert figures._short("/folder/" + "a" * 36) == "a" * 36
    assert figures._short("/folder/" + "a" * 20 + "b" * 17) == "a" * 20 + "…" + "b" * 15
    none = [None] * figures.MOST_RECORDINGS
    assert (figures._not_drawn(none), figures._not_drawn([*none, None])) == ("", " 1 more recording is not drawn.")


def shown_of(drive, sine=None, role="loops"):
    return figures.Shown("name", role, drive, drive, 1000.0, sine, None)


@pytest.mark.parametrize(
    ("role", "excited", "freq_hz", "spans", "title"),
    [
        ("broadband", (10.0, 20.0), 40.0, 1, ""),
        ("broadband", None, 40.0, 0, "40 Hz"),
        ("loops", (10.0, 20.0), 40.0, 0, "40 Hz"),
        ("loops", (10.0, 20.0), 12345.0, 0, "12.35 kHz"),
        ("loops", (10.0, 20.0), None, 0, ""),
    ],
)
def test_a_spectrum_has_the_excited_band_or_the_frequency_of_its_sine(role, excited, freq_hz, spans, title):
    drive = np.sin(0.25 * np.arange(400.0))
    found = SimpleNamespace(linear=excited and SimpleNamespace(excited_hz=excited))
    sine = freq_hz and words.Sine(freq_hz, 1.0)
    _, right = figures.excitation([shown_of(drive, sine, role)], found).sheet.panels
    assert len(right.all_of(Span)) == spans
    assert right.title == title


def test_the_last_period_of_a_steady_sine_is_drawn_and_the_last_swings_of_others():
    t = np.arange(4000) / 1000.0
    steady, growing = np.sin(2 * np.pi * 50 * t), (1 + t) * np.sin(2 * np.pi * 50 * t)
    part = slice(100, 4000)
    assert figures._stretch(shown_of(steady, words.Sine(50.0, 1.0)), part) == slice(3979, 4000)
    assert figures._stretch(shown_of(steady, words.Sine(50.0, 1.0)), slice(3990, 4000)) == slice(3990, 4000)
    for one in (shown_of(growing, words.Sine(50.0, 5.0)), shown_of(steady)):
        crossings = np.diff(one.drive_v[part] > one.drive_v.mean()).sum()
        assert figures._stretch(one, part) == slice(4000 - 3900 * 40 // crossings, 4000)
    for count, kept in ((40, 200), (41, 200 * 40 // 41)):
        drive = np.r_[(-1.0) ** np.arange(count), np.full(200 - count, (-1.0) ** count)]
        assert figures._stretch(shown_of(drive), slice(0, 200)) == slice(200 - kept, 200)


def test_the_time_response_is_to_the_chirp_where_there_is_one(full, recordings, monkeypatch):
    title = figures.time_response(full, recordings).title
    assert title.startswith("Time response to the chirp, fit ") and title.endswith(" %")
    monkeypatch.setattr(figures, "is_chirp", lambda recording: False)
    assert figures.time_response(full, recordings).title.startswith("Time response of the linear part, fit ")
    assert figures.time_response(replace(full, linear=None), recordings) is None
    assert figures.time_response(full, recordings[:3]) is None


def test_without_files_the_data_name_none(full):
    data = report.identification_data(full, full.chosen)
    assert (data["mirror_file"], data["report_file"]) == (None, None)
    both = report.identification_data(full, full.chosen, mirror_file=Path("a.toml"), report_file=Path("b.html"))
    assert (both["mirror_file"], both["report_file"]) == ("a.toml", "b.html")


@pytest.mark.parametrize("sign", [1, -1])
def test_the_data_say_whether_the_output_rises_or_falls_with_the_drive(sign):
    """The weights of its play operators are those of a mirror that rises."""
    drive = 5.0 - 5.0 * np.cos(2.0 * np.pi * 5.0 * np.arange(1200) / RATE_HZ)
    output = sign * 1e-4 * play_response(drive, np.array([0.0, 1.0]), np.zeros(2)) @ np.array([0.8, 0.2])
    of = recording_from_arrays(drive, output, RATE_HZ, "slow.csv")
    found = identify([of], hold_out=0.5, models=("prandtl_ishlinskii",))
    plays = report.identification_data(found, found.chosen)["parameters"]["prandtl_ishlinskii"]
    assert plays["sign"] == sign
    assert sum(plays["weights_rad_v"]) > 0.0


# --------------------------------------------------------------------------- records unlike each other, held as a whole
def ns(**values):
    return SimpleNamespace(**values)


def made(kind, **values):
    """A record of a kind with these fields alone."""
    found = object.__new__(kind)
    for name, value in values.items():
        object.__setattr__(found, name, value)
    return found


def rich_linear():
    """Two pairs and a real pole, one zero, three frequencies: every number unlike the others."""
    poles = 2 * np.pi * np.array([-3.0 + 4.0j, -3.0 - 4.0j, -12.0 + 0j])
    freq = np.array([2.0, 8.0, 32.0])
    value, left = np.array([4e-3, -1e-3j, 2e-4]), np.array([1e-4, 2e-5 + 1e-5j, -1e-5])
    error = np.array([3e-5, 2e-5, 1e-5])
    return ns(
        order=3,
        hold="zero-order",
        reason="the knee of the criterion",
        excited_hz=(2.0, 32.0),
        rate_hz=500.0,
        poles_rad_s=poles,
        poles_error_rad_s=2 * np.pi * np.array([0.25, 0.25, 0.5]),
        zeros_rad_s=2 * np.pi * np.array([40.0 + 0j]),
        zeros_error_rad_s=2 * np.pi * np.array([1.5]),
        dc_gain=np.array([[5e-3]]),
        dc_gain_error=np.array([[4e-4]]),
        edge_gain=np.array([[4.5e-3]]),
        edge_gain_error=np.array([[2e-4]]),
        fit_percent=np.array([97.5]),
        residual_rms=np.array([6e-7]),
        scan=(),
        residual=left[:, None, None],
        response=ns(
            freq_hz=freq,
            response=value[:, None, None],
            standard_error=error[:, None, None],
            noise_standard_error=0.5 * error[:, None, None],
            distortion_standard_error=None,
            coherence=np.array([[0.99], [0.97], [0.8]]),
            method="a method",
        ),
    )


def test_the_response_of_a_linear_part_is_drawn_with_its_model_levels_and_coherence():
    assert figure_of(figures.response(rich_linear())) == [
        "response",
        "Frequency response of the linear part",
        (
            "Frequency response without a model (a method) and the linear model behind the "
            "same zero-order hold. Below: what the model leaves at each frequency, and as rms "
            "over bands one standard error of the response with the parts of it that are noise "
            "and nonlinear distortion, where the recordings tell them apart."
        ),
        {},
        "Sheet width=8.2 height=8.4 heights=[3 2 2.4 1.2] share_x=True",
        "Panel 0 0 x=<log=True> y=<title=gain (µrad/V) log=True> legend=<>",
        "Area rings=[[[2 3958.42] [8 972.281] [32 186.141] [32 213.859] [8 1027.72] [2 4041.58]]]",
        "  colour=#56B4E9 opacity=0.6 label=95 % confidence",
        "Line x=[2 8 32] y=[4000 1000 200] colour=#0072B2 dash= label=measured marker=. size=4.5",
        ("Line x=[2 8 32] y=[3900 1010.2 210] colour=#D55E00 dash=-- width=1.4 label=linear model, order 3"),
        "Panel 1 0 x=<log=True> y=<title=phase (°) low=-111.134 high=20>",
        ("Area rings=[[[2 -0.59557] [8 -91.5884] [32 -3.97358] [32 3.97358] [8 -88.4116] [2 0.59557]]]"),
        "  colour=#56B4E9 opacity=0.6",
        "Line x=[2 8 32] y=[0 -90 0] colour=#0072B2 dash= marker=. size=4.5",
        "Line x=[2 8 32] y=[0 -91.1344 0] colour=#D55E00 dash=-- width=1.4",
        "Panel 2 0 x=<log=True> y=<title=level (µrad/V) log=True> legend=<>",
        ("Line x=[2 8 32] y=[100 22.3607 10] colour=#E69F00 dash= label=measured less modelled marker=."),
        "  size=4",
        "Line x=[2 8 32] y=[30 20 10] width=1.6 label=standard error",
        "Line x=[2 8 32] y=[15 10 5] colour=#009E73 dash=-. width=1.6 label=noise",
        "Panel 3 0 x=<title=frequency (Hz) log=True> y=<title=coherence (1) low=0.78 high=1.01>",
        "Line x=[2 8 32] y=[0.99 0.97 0.8] colour=#0072B2 dash= marker=. size=4.5",
    ]


def test_poles_and_zeros_are_drawn_with_their_own_errors():
    assert figure_of(figures.poles(rich_linear())) == [
        "poles",
        "Poles and zeros of the linear part",
        (
            "Poles and zeros with one standard error. A damping of 1 is a real one; zeros "
            "below 0 lie in the right half plane. What lies outside the shaded band is "
            "extrapolated."
        ),
        {},
        "Sheet width=8.2 height=3.4",
        ("Panel 0 0 x=<title=natural frequency (Hz) log=True low=0.6 high=120> y=<title=damping ratio (1)>"),
        "  legend=<place=above columns=3>",
        "Span low=2 high=32 upright=True colour=#56B4E9 opacity=0.2 label=excited band",
        ("Line x=[5 12] y=[0.6 1] colour=#D55E00 dash= label=poles marker=x size=8 face= x_arms=[[0.25"),
        "  0.5] [0.25 0.5]] y_arms=[[0.05 0] [0.05 0]]",
        ("Line x=[40] y=[-1] colour=#0072B2 dash= label=zeros marker=o size=8 face= x_arms=[[1.5] [1.5]]"),
        "  y_arms=[[0] [0]]",
        "Rule at=0 upright=False width=0.7",
    ]


def test_the_numbers_of_a_linear_part_stand_under_their_own_names():
    assert rounded_numbers(identification_numbers._linear_data(rich_linear())) == {
        "order": 3,
        "reason": "the knee of the criterion",
        "fit_percent": 97.5,
        "residual_rms_rad": 6e-07,
        "excited_hz": [2.0, 32.0],
        "rate_hz": 500.0,
        "dc_gain_rad_v": 0.005,
        "dc_gain_standard_error_rad_v": 0.0004,
        "edge_gain_rad_v": 0.0045,
        "edge_gain_standard_error_rad_v": 0.0002,
        "poles_and_zeros": [
            {
                "kind": "pole",
                "freq_hz": 5.0,
                "freq_error_hz": 0.25,
                "damping": 0.6,
                "damping_error": 0.05,
                "excited": True,
            },
            {
                "kind": "pole",
                "freq_hz": 12.0,
                "freq_error_hz": 0.5,
                "damping": 1.0,
                "damping_error": 0.0,
                "excited": True,
            },
            {
                "kind": "zero",
                "freq_hz": 40.0,
                "freq_error_hz": 1.5,
                "damping": -1.0,
                "damping_error": 0.0,
                "excited": False,
            },
        ],
        "orders": [],
    }
    rows = [[str(cell) for cell in row] for row in identification_page._roots(rich_linear()).rows]
    assert rows == [
        ["pole pair", "5 Hz", "0.25 Hz", "0.6", "0.05", "yes", ""],
        ["pole, real", "12 Hz", "0.5 Hz", "1", "", "yes", ""],
        ["zero, real", "40 Hz", "1.5 Hz", "−1", "", "no", "extrapolated"],
        ["gain at zero frequency", "5 mrad/V", "0.4 mrad/V", "", "", "no", "extrapolated"],
        ["gain at 2 Hz", "4.5 mrad/V", "0.2 mrad/V", "", "", "yes", ""],
    ]


def test_a_model_with_confidence_has_bands_about_its_size_and_its_phase():
    sheet, panels = figures.grid(8.0, 4.0, 2)
    freq, value = np.array([1.0, 10.0, 100.0]), np.array([2.0 + 0j, -1.0j, -0.5])
    measured = figures.Measured(freq[:2], value[:2] * np.array([1.5, 0.5j]), np.array([0.25, 0.125]))
    model = figures.Modelled(freq, value, "a model", np.array([0.1, 0.2, 0.05]), np.array([0.01, 0.02, 0.03]))
    figures.bode(tuple(panels), measured, model)
    assert lines_of(sheet) == [
        "Sheet width=8 height=4 heights=[1 1]",
        "Panel 0 0 x=<log=True> y=<log=True low=0.25>",
        ("Area rings=[[[1 2.75] [10 0.375] [10 0.625] [1 3.25]]] colour=#56B4E9 opacity=0.6 label=95 %"),
        "  confidence",
        "Line x=[1 10] y=[3 0.5] colour=#0072B2 dash= label=measured marker=. size=4.5",
        "Area rings=[[[1 1.9] [10 0.8] [100 0.45] [100 0.55] [10 1.2] [1 2.1]]] colour=#D55E00",
        "  opacity=0.3 label=95 % confidence of the model",
        "Line x=[1 10 100] y=[2 1 0.5] colour=#D55E00 dash=-- width=1.4 label=a model",
        "Panel 1 0 x=<log=True> y=<title=phase (°) low=-200 high=20>",
        ("Area rings=[[[1 -4.78019] [10 -14.4775] [10 14.4775] [1 4.78019]]] colour=#56B4E9 opacity=0.6"),
        "Line x=[1 10] y=[0 0] colour=#0072B2 dash= marker=. size=4.5",
        "Area rings=[[[1 -0.572958] [10 -91.1459] [100 -181.719] [100 -178.281] [10 -88.8541] [1",
        "  0.572958]]] colour=#D55E00 opacity=0.3",
        "Line x=[1 10 100] y=[0 -90 -180] colour=#D55E00 dash=-- width=1.4",
    ]


def two_recordings():
    """A sine, fitted and unseen, and a drive of many frequencies, unseen only; made of few samples."""
    drive = np.array([0.0, 1.0, 0.0, -1.0] * 4)
    other = np.array([0.0, 2.0, -1.0, 3.0, -3.0, 1.0, 0.5, -0.5])
    first = ns(
        start=4,
        split=12,
        measured_rad=1e-3 * drive + np.tile([3e-5, 1e-5, -2e-5, 4e-5], 4),
        model_rad=0.9e-3 * drive + 7e-5,
        residual_rad=1e-4 * drive + 1e-6,
    )
    second = ns(
        start=2,
        split=2,
        measured_rad=2e-3 * other + np.array([0.0, 0.0, 3e-4, 1e-4, 2e-4, -5e-4, 4e-4, -1e-4]),
        model_rad=1.5e-3 * other + 6e-4,
        residual_rad=5e-4 * other,
    )
    one = figures.Shown("one.csv", "loops", drive, first.measured_rad, 8.0, words.Sine(2.0, 1.0), first)
    two = figures.Shown("two.csv", "validation", other, second.measured_rad, 4.0, None, second)
    return [one, two]


def test_loops_of_a_sine_and_of_another_drive_are_drawn_less_their_own_lines():
    assert figure_of(figures.loops(two_recordings(), ns(chosen="linear"))) == [
        "loops",
        "Loops, measured against modelled",
        (
            "Measured against modelled by linear. Right: the same less the straight line that "
            "fits the measured output of that recording best, which leaves the hysteresis, and "
            "at high frequency the phase lag with it. Of a sine of constant amplitude the last "
            "period of either part is drawn, of others at most some twenty swings; the initial "
            "transient is left out."
        ),
        {},
        "Sheet width=8.2 height=5.5 heights=[1 1] widths=[1 1] legend=<place=above columns=3>",
        "Panel 0 0 x=<title=drive (V)> y=<title=output (mrad)> title=one.csv",
        ("Line x=[-1 0 1 0 -1] y=[-0.975 0.015 0.995 -0.035 -0.975] colour=#56B4E9 width=2 label=measured,"),
        "  fitted",
        ("Line x=[0 1 0 -1] y=[0.015 0.995 -0.035 -0.975] colour=#0072B2 width=2 label=measured, unseen by"),
        "  the fit",
        "Line x=[-1 0 1 0 -1] y=[-0.845 0.055 0.955 0.055 -0.845] colour=#D55E00 dash=-- width=1",
        "  label=modelled",
        ("Line x=[0 1 0 -1] y=[0.055 0.955 0.055 -0.845] colour=#D55E00 dash=-- width=1 label=modelled"),
        ("Panel 0 1 x=<title=drive (V)> y=<title=output less line (µrad)> title=2 Hz, ± 1 V: unseen 70.7"),
        "  µrad rms",
        "Line x=[-1 0 1 0 -1] y=[10 15 10 -35 10] colour=#56B4E9 width=2 label=measured, fitted",
        ("Line x=[0 1 0 -1] y=[15 10 -35 10] colour=#0072B2 width=2 label=measured, unseen by the fit"),
        "Line x=[-1 0 1 0 -1] y=[140 55 -30 55 140] colour=#D55E00 dash=-- width=1 label=modelled",
        "Line x=[0 1 0 -1] y=[55 -30 55 140] colour=#D55E00 dash=-- width=1 label=modelled",
        "Panel 1 0 x=<title=drive (V)> y=<title=output (mrad)> title=two.csv (validation)",
        "Line x=[-1 3 -3 1 0.5 -0.5] y=[-1.76667 6.03333 -5.86667 1.43333 1.33333 -1.16667]",
        "  colour=#0072B2 width=2 label=measured, unseen by the fit",
        "Line x=[-1 3 -3 1 0.5 -0.5] y=[-0.966667 5.03333 -3.96667 2.03333 1.28333 -0.216667]",
        "  colour=#D55E00 dash=-- width=1 label=modelled",
        ("Panel 1 1 x=<title=drive (V)> y=<title=output less line (µrad)> title=many frequencies: unseen"),
        "  924 µrad rms",
        ("Line x=[-1 3 -3 1 0.5 -0.5] y=[191.87 157.724 8.94309 -525.203 354.065 -187.398] colour=#0072B2"),
        "  width=2 label=measured, unseen by the fit",
        ("Line x=[-1 3 -3 1 0.5 -0.5] y=[991.87 -842.276 1908.94 74.7967 304.065 762.602] colour=#D55E00"),
        "  dash=-- width=1 label=modelled",
    ]


def test_residuals_of_two_recordings_are_drawn_where_they_were_seen_and_unseen():
    assert figure_of(figures.residuals(two_recordings())) == [
        "residuals",
        "Residuals",
        (
            "Measured less modelled. Light: samples that the model was fitted to; dark: "
            "samples that no fit has seen. The initial transient is left out."
        ),
        {},
        "Sheet width=8.2 height=2.4 widths=[1 1]",
        "Panel 0 0 x=<title=time (s) most=7> y=<title=residual (µrad)> title=one.csv",
        ("Line x=[0.5 0.625 0.75 0.875 1 1.125 1.25 1.375] y=[1 101 1 -99 1 101 1 -99] colour=#56B4E9"),
        "  width=0.7 name=fitted",
        "Line x=[1.5 1.625 1.75 1.875] y=[1 101 1 -99] colour=#0072B2 width=0.7 name=unseen",
        "Rule at=0 upright=False width=0.7",
        "Panel 0 1 x=<title=time (s) most=7> y=<title=residual (µrad)> title=two.csv (validation)",
        "Line x=[] y=[] colour=#56B4E9 width=0.7 name=fitted",
        ("Line x=[0.5 0.75 1 1.25 1.5 1.75] y=[-500 1500 -1500 500 250 -250] colour=#0072B2 width=0.7"),
        "  name=unseen",
        "Rule at=0 upright=False width=0.7",
    ]


def test_excitations_of_two_recordings_are_drawn_with_the_lines_of_their_spectra():
    assert figure_of(figures.excitation(two_recordings(), ns(linear=None))) == [
        "excitation",
        "Excitation",
        (
            "Drive of each recording, and the amplitude of its spectral lines (the strongest "
            "of those that fall on one point). Shaded: the band that counts as excited for the "
            "linear part."
        ),
        {},
        "Sheet width=8.2 height=3.9 heights=[1 1] widths=[1 1]",
        "Panel 0 0 x=<title=time (s) most=7> y=<title=drive (V)> title=one.csv (loops)",
        ("Line x=[0 0.125 0.25 0.375 0.5 0.625 0.75 0.875 1 1.125 1.25 1.375 1.5 1.625 1.75 1.875] y=[0 1"),
        "  0 -1 0 1 0 -1 0 1 0 -1 0 1 0 -1] width=0.7",
        "Panel 0 1 x=<title=frequency (Hz) log=True low=0.5 high=4> y=<title=amplitude (V) log=True",
        "  low=1e-05> title=2 Hz",
        "Line x=[2 2 2] y=[1e-05 1 nan] width=0.8 whole=True",
        "Panel 1 0 x=<title=time (s) most=7> y=<title=drive (V)> title=two.csv (validation)",
        "Line x=[0 0.25 0.5 0.75 1 1.25 1.5 1.75] y=[0 2 -1 3 -3 1 0.5 -0.5] width=0.7",
        "Panel 1 1 x=<title=frequency (Hz) log=True low=0.5 high=2> y=<title=amplitude (V) log=True",
        "  low=2.25e-05>",
        ("Line x=[0.5 0.5 0.5 1 1 1 1.5 1.5 1.5 2 2 2] y=[2.25e-05 0.521264 nan 2.25e-05 0.637377 nan"),
        "  2.25e-05 1.67056 nan 2.25e-05 2.25 nan] width=0.8 whole=True",
    ]


def test_the_tests_of_a_residual_are_those_of_the_longest_unseen_part():
    one, two = (each.prediction for each in two_recordings())
    two.split, two.residual_rad = 3, np.array([0.0, 0.0, 1e-6, -1e-6, 2e-6, -2e-6, 1e-6, 4e-7])
    score = ns(model="linear")
    test = ns(
        bound=0.25, autocorrelation=np.array([0.1, -0.3, 0.2]), cross_correlation=np.array([0.4, 0.05]), white=False,
        independent=True, outside=(0.125, 0.0625), samples=77,
    )  # fmt: skip
    recordings = [ns(path="/a/one.csv", rate_hz=8.0), ns(path="/a/two.csv", rate_hz=4.0)]
    found = ns(residual=test, scores=[score], chosen="linear", predictions=[(one, two)], recordings=recordings)
    assert figure_of(figures.residual_tests(found)) == [
        "tests",
        "Tests of the residual",
        (
            "Of the longest unseen part, two.csv: of a residual that is noise 95 % of the "
            "lines lie within the shaded ± 0.25. For the correlation with the drive both are "
            "whitened first."
        ),
        {},
        "Sheet width=8.2 height=2.9 widths=[1 1 1]",
        "Panel 0 0 x=<title=lag (samples)> y=<title=autocorrelation (1) low=-0.55 high=0.55>",
        "Span low=-0.25 high=0.25 upright=False colour=#56B4E9 opacity=0.4",
        "Line x=[1 1 1 2 2 2 3 3 3] y=[0 0.1 nan 0 -0.3 nan 0 0.2 nan] colour=#0072B2 width=1.2",
        "  whole=True",
        "Rule at=0 upright=False width=0.7",
        "Panel 0 1 x=<title=lag (samples)> y=<title=correlation with drive (1) low=-0.55 high=0.55>",
        "Span low=-0.25 high=0.25 upright=False colour=#56B4E9 opacity=0.4",
        "Line x=[0 0 0 1 1 1] y=[0 0.4 nan 0 0.05 nan] colour=#0072B2 width=1.2 whole=True",
        "Rule at=0 upright=False width=0.7",
        ("Panel 0 2 x=<title=frequency (Hz) log=True> y=<title=density (µrad/√Hz) log=True> legend=<>"),
        "Line x=[0.8 1.6] y=[1430.16 1513.12] dash=-- width=1 label=output",
        "Line x=[0.8 1.6] y=[0.78774 1.57868] colour=#0072B2 width=1 label=residual",
    ]
    assert words.residual_sentences(found) == [
        "The residual is not white: 12 % of its autocorrelations lie outside ± 0.25.",
        ("It is independent of the drive: 6 % of the cross-correlations lie outside; 5 % would be noise."),
    ]
    assert rounded_numbers(identification_numbers._residual_data(found)) == {
        "samples": 77,
        "bound": 0.25,
        "white": False,
        "independent_of_drive": True,
        "share_of_autocorrelations_outside": 0.125,
        "share_of_cross_correlations_outside": 0.0625,
        "autocorrelation": [0.1, -0.3, 0.2],
        "cross_correlation": [0.4, 0.05],
    }


def a_joint_fit():
    """A fit of a hysteresis with a linear part of which one pole was held, and a creep lag."""
    poles = ns(frequencies_hz=(7.0, 70.0, 700.0), dampings=(0.1, 0.2, 1.0))
    zeros = ns(frequencies_hz=(90.0,), dampings=(-0.3,))
    named = [ns(name="alpha", unit="rad/V"), ns(name="pole 1", unit="Hz"), ns(name="delay", unit="s")]
    correlation = np.array([[1.0, 0.1, -0.99], [0.1, 1.0, 0.96], [-0.99, 0.96, 1.0]])
    return ns(
        structure=ns(parameters=named),
        fit=ns(
            values=np.array([2.5e-3, 7.125, -3e-4]),
            standard_errors=np.array([1e-5, 0.0625, 2e-5]),
            correlation=correlation,
        ),
        linear=ns(poles=poles, zeros=zeros),
        creep=ns(time_constants_s=(0.5, 20.0)),
    )


def test_held_poles_zeros_and_lags_stand_behind_the_fitted_parameters():
    rows = parameter_rows(a_joint_fit())
    assert [[row.name, *row.shown, row.note] for row in rows][:1] == [
        ["alpha", pytest.approx(2.5), pytest.approx(0.01), "mrad/V", ""]
    ]
    assert rounded_numbers(rows) == [
        {"name": "alpha", "value": 0.0025, "standard_error": 1e-05, "unit": "rad/V", "note": ""},
        {"name": "pole 1", "value": 7.125, "standard_error": 0.0625, "unit": "Hz", "note": ""},
        {"name": "delay", "value": -0.0003, "standard_error": 2e-05, "unit": "s", "note": ""},
        {
            "name": "pole 2",
            "value": 70.0,
            "standard_error": "nan",
            "unit": "Hz",
            "note": "held, from the frequency response",
        },
        {
            "name": "pole 2 damping",
            "value": 0.2,
            "standard_error": "nan",
            "unit": "",
            "note": "held, from the frequency response",
        },
        {
            "name": "pole 3",
            "value": 700.0,
            "standard_error": "nan",
            "unit": "Hz",
            "note": "held, from the frequency response",
        },
        {
            "name": "zero 1",
            "value": 90.0,
            "standard_error": "nan",
            "unit": "Hz",
            "note": "held, from the frequency response",
        },
        {
            "name": "zero 1 damping",
            "value": -0.3,
            "standard_error": "nan",
            "unit": "",
            "note": "held, from the frequency response",
        },
        {"name": "creep lag 1", "value": 0.5, "standard_error": "nan", "unit": "s", "note": "chosen"},
        {"name": "creep lag 2", "value": 20.0, "standard_error": "nan", "unit": "s", "note": "chosen"},
    ]
    assert [(a, b, round(r, 6)) for a, b, r in parameters.correlations(a_joint_fit(), 0.5)] == [
        ("delay", "alpha", -0.99),
        ("delay", "pole 1", 0.96),
    ]


def test_weights_that_fall_with_the_drive_have_their_sign_and_a_held_one_says_so():
    fit = made(
        PrandtlIshlinskiiFit,
        thresholds_v=np.array([0.0, 1.25, 3.0]),
        sign=-1.0,
        weights_rad_per_v=np.array([2e-3, 0.0, 5e-4]),
        standard_errors_rad_per_v=np.array([1e-5, 3e-5, 2e-5]),
        condition_number=12.5,
        colour_inflation=3.25,
    )
    assert rounded_numbers(parameter_rows(fit)) == [
        {"name": "weight at 0 V", "value": -0.002, "standard_error": 1e-05, "unit": "rad/V", "note": ""},
        {
            "name": "weight at 1.25 V",
            "value": 0.0,
            "standard_error": 3e-05,
            "unit": "rad/V",
            "note": "held at 0 by its bound",
        },
        {"name": "weight at 3 V", "value": -0.0005, "standard_error": 2e-05, "unit": "rad/V", "note": ""},
    ]
    assert rounded_numbers(identification_numbers._parameter_data(fit)) == {
        "admissible": True,
        "not_identified": {},
        "agreeing_starts": None,
        "starts": None,
        "condition_number": 12.5,
        "colour_inflation": 3.25,
        "thresholds_v": [0.0, 1.25, 3.0],
        "weights_rad_v": [0.002, 0.0, 0.0005],
        "standard_errors_rad_v": [1e-05, 3e-05, 2e-05],
        "sign": -1.0,
    }
    assert parameters.notes(fit) == [
        ("The weights are a non-negative least-squares problem, which has one minimum: no starts are needed."),
        ("Condition number 12.5; the variances are inflated 3.25 times for the colour of the residual."),
    ]
    rows = [[str(cell) for cell in row] for row in identification_page._model(fit).rows]
    assert rows == [
        ["weight at 0 V", "−2", "0.01", "mrad/V", ""],
        ["weight at 1.25 V", "0", "0.03", "mrad/V", "held at 0 by its bound"],
        ["weight at 3 V", "−0.5", "0.02", "mrad/V", ""],
    ]


def test_a_bouc_wen_fit_says_what_is_not_identified_and_how_many_starts_agreed():
    covariance = np.diag([1e-10, 4e-14, 9e-12, 1e-12, 1e-2, 4e-4])
    covariance[4, 0] = covariance[0, 4] = -9.75e-7
    fit = made(
        BoucWenFit,
        model=BoucWen(1e-3, 2e-6, 3e-4, 4e-5, 5.0, 1.5, rate_limit_v_s=700.0),
        covariance=covariance,
        not_identified=(ns(name="d2", reason="too slow"),),
        admissible=True,
        agreeing_starts=3,
        start_rms_percent=(1.0, 2.0, 3.0, 4.0),
        condition_number=450.0,
        colour_inflation=1.75,
    )
    assert rounded_numbers(parameter_rows(fit)) == [
        {"name": "d1", "value": 0.001, "standard_error": 1e-05, "unit": "rad/V", "note": ""},
        {"name": "d2", "value": 2e-06, "standard_error": 2e-07, "unit": "s/V", "note": ""},
        {"name": "epsilon", "value": 0.0003, "standard_error": 3e-06, "unit": "rad/V", "note": ""},
        {"name": "delta", "value": 4e-05, "standard_error": 1e-06, "unit": "s/V", "note": ""},
        {"name": "alpha", "value": 5.0, "standard_error": 0.1, "unit": "1/V", "note": ""},
        {"name": "beta", "value": 1.5, "standard_error": 0.02, "unit": "1/V", "note": ""},
    ]
    assert parameters.notes(fit) == [
        "3 of 4 starts reached the best fit.",
        "Correlated above 0.95: alpha and d1 −0.975.",
        (
            "Better fixed than its parts: the hysteresis of a slow settled loop, |epsilon| / "
            "(alpha + sign(epsilon) beta) = 46.15 ± 0.86 µrad."
        ),
        ("Condition number 450; the variances are inflated 1.75 times for the colour of the residual."),
    ]
    assert parameters.starts(fit) == (3, 4) and parameters.starts_text(fit) == "3 of 4 starts reached the best fit"
    data = identification_numbers._parameter_data(fit)
    assert (data["agreeing_starts"], data["starts"]) == (3, 4)
    rows = [[str(cell) for cell in row] for row in identification_page._model(fit).rows]
    assert rows == [
        ["d1", "1", "0.01", "mrad/V", ""],
        ["d2", "2e-06", "2e-07", "s/V", "not identified: too slow"],
        ["epsilon", "0.3", "0.003", "mrad/V", ""],
        ["delta", "4e-05", "1e-06", "s/V", ""],
        ["alpha", "5", "0.1", "1/V", ""],
        ["beta", "1.5", "0.02", "1/V", ""],
    ]


@pytest.mark.parametrize(
    ("count", "noun", "said"), [(0, "record", "0 records"), (1, "record", "1 record"), (2, "pole", "2 poles")]
)
def test_a_number_stands_with_its_noun(count, noun, said):
    assert identification_terminal.counted(count, noun) == said


@pytest.mark.parametrize(
    ("refused", "width", "room", "said"),
    [
        (0, 40, 9, ["- one short warning", "- two", "- three of them with more words than a", "  line has"]),
        (
            2,
            40,
            3,
            ["- one short warning", "- two", "- 1 more warning and 2 refused models: see the report, or --json."],
        ),
        (0, 40, 2, ["- one short warning", "- 2 more warnings: see the report, or --json."]),
        (1, 12, 2, ["- one short …", "- 2 more warnings and 1 refused model: see the report, or --json."]),
    ],
)
def test_warnings_that_have_no_room_are_counted(refused, width, room, said):
    warnings = ["one short warning", "two", "three of them with more words than a line has"]
    shown = identification_terminal.warnings_text(warnings, refused, width, room).split("\n")
    assert len(shown) <= max(room, 2) + 1
    assert shown[-1] == said[-1] and shown[0][:9] == said[0][:9]


def test_a_drive_of_sixty_hertz_about_six_volts_is_told_in_volts():
    t = np.arange(400) / 2000.0
    recording = ns(drive=(3.0 + 2.5 * np.sin(2 * np.pi * 60.0 * t))[:, None], rate_hz=2000.0)
    assert words.drive_text(recording, 2.0) == "60 Hz, ± 5 V about 6 V"
    assert words.drive_text(ns(drive=recording.drive, rate_hz=66666.7), 2.0) == "2 kHz, ± 5 V about 6 V"


@pytest.mark.parametrize(
    ("freq_hz", "samples", "size", "found"),
    [
        (10.0, 1000, 2.5, (10.0, 2.5)),
        (2.0, 1000, 1.0, (2.0, 1.0)),
        (1.0, 1000, 1.0, None),
        (13.3, 950, 0.25, (13.3, 0.25)),
    ],
)
def test_a_drive_is_a_sine_from_two_periods_on_wherever_it_is_centred(freq_hz, samples, size, found):
    time = np.arange(samples) / 1000.0
    sine = words.sine_of(7.0 - size * np.sin(2 * np.pi * freq_hz * time), 1000.0)
    assert (sine and (sine.freq_hz, sine.amplitude_v)) == (found and pytest.approx(found, rel=1e-5))
    assert words.sine_of(7.0 + np.where(time % 0.1 < 0.03, size, 0.0), 1000.0) is None


def test_large_frequencies_and_errors_are_told_without_powers_of_ten():
    linear = ns(excited_hz=(1000.0, 5000.0), dc_gain=np.eye(1), dc_gain_error=np.eye(1), edge_gain=np.eye(1))
    linear.edge_gain_error = np.eye(1)
    found = ns(linear=linear, drive_min_v=0.0, drive_max_v=1.0, rate_limit_v_per_s=12346.0 * math.pi, fit=lambda: None)
    assert words._band(found) == "The linear part was excited from 1 kHz to 5 kHz, but the model does not use it."
    assert words.range_text(found).endswith("which a sine over that range reaches at 12.35 kHz.")
    assert [each[0] for each in words.gains(linear)] == ["zero frequency", "1 kHz"]
    assert words.error_text(ns(held_out_rms_percent=12.34), 10e-3) == "1230 µrad rms (12.3 %)"
    worst = words.worst_text(ns(worst="a.csv", worst_rms_rad=1.234e-3, worst_peak_rad=9.9996e-3), 10e-3)
    assert worst.endswith("a.csv, with 1230 µrad rms (12.3 %) and 10000 µrad at most.")


# ------------------------------------------------------------------------------------------------ the page as a whole
def plays(k, sign=1.0):
    """Play operators of which each number is unlike those of others."""
    return made(
        PrandtlIshlinskiiFit,
        thresholds_v=np.array([0.0, 0.5 * k]),
        sign=sign,
        weights_rad_per_v=np.array([2e-3 * k, 3e-3]),
        standard_errors_rad_per_v=np.array([1e-5 * k, 2e-5]),
        condition_number=12.5 * k,
        colour_inflation=3.25 * k,
    )


def a_found(**changes):
    """Two recordings judged and one that served the linear part alone, of which the identification keeps no more."""
    named = [f"{chr(97 + k)}/r{k}.csv" for k in range(3)]
    roles = ("loops", "validation", "broadband")
    sources = [ns(path=p, sha256=f"{k}f", role=roles[k], fitted=10 + k, held_out=20 + k) for k, p in enumerate(named)]
    time = np.arange(64) / 64.0
    kept = [
        ns(
            path=named[k],
            sha256=f"{k}f",
            drive=(3.0 + (k + 1) * np.sin(2 * np.pi * 4 * (k + 1) * time))[:, None],
            rate_hz=64.0 * (k + 1),
            samples=64,
            step_s=1.0 / (64.0 * (k + 1)),
            findings=[ns(kind="clipped", message=f"says {k}", refused=bool(k))],
        )
        for k in range(2)
    ]
    predictions = [
        ns(start=1, split=3 - 2 * k, residual_rad=1e-6 * np.array([9.0, 1.0, 2.0, 3.0 + k, 4.0]), clamped=7 * k)
        for k in range(2)
    ]
    scores = [
        ns(
            model=f"m{k}",
            fit_rms_percent=1.5 - k / 8,
            fit_peak_percent=4.5 - k,
            held_out_rms_percent=2.5 - k,
            held_out_peak_percent=6.5 - k,
        )
        for k in range(2)
    ]
    line = ns(
        model="straight line",
        fit_rms_percent=7.5,
        fit_peak_percent=8.5,
        held_out_rms_percent=2.0,
        held_out_peak_percent=9.5,
    )
    given = {
        "recordings": kept, "sources": sources, "predictions": [None, predictions], "scores": scores, "chosen": "m1",
        "fits": [plays(1), plays(2, -1.0)], "straight_line": line, "span_rad": 2.5e-4, "units": ns(volts=10.0),
        "linear": None, "refused": [Refused("m7", "too short")], "reason": "A reason.",
        "residual": ns(white=True, independent=False, bound=0.125, outside=(0.04, 0.5)),
    }  # fmt: skip
    return ns(**given | changes)


def test_a_page_of_an_identification_has_each_number_of_its_recordings_and_models(monkeypatch):
    monkeypatch.setattr(identification_page.words, "warnings", lambda found, written: [f"of {written}"])
    views = identification_page._views(a_found(), "m0", (), {name: ns(name=name) for name in PICTURES})
    assert outline(*views) == one_text("""
# Warnings and refusals
- of m0
Models that these recordings cannot support:
- m7: too short
# Recordings
| -: file / serves as / drive / sample rate / fitted / held out / duration [0, 1, 2] brief [0, 1, 4, 5]
r0.csv / loops / 4 Hz, ± 10 V about 30 V / 64 Hz / 10 / 20 / 1 s
r1.csv / validation / 16 Hz, ± 20 V about 30 V / 128 Hz / 11 / 21 / 500 ms
r2.csv / broadband /  /  / 12 / 22 /
What the checks of the recordings noticed:
- r0.csv, clipped: says 0
- r1.csv, clipped (accepted): says 1
[excitation]
# Linear part
No model with a linear part was asked for, so the broadband recordings were not used.
# Loops
[loops]
Error of m1 on each recording:
| -: file / drive / fitted, rms / unseen, rms / unseen, rms / rate-clamped [0, 1] brief [0, 2, 3, 4]
r0.csv / 4 Hz, ± 10 V about 30 V / 1.58 µrad / 3.54 µrad / 1.41 % / 0
r1.csv / 16 Hz, ± 20 V about 30 V /  / 3.04 µrad / 1.22 % / 7
# Time response
No broadband recording was used: there is no linear model to compare.
# Residuals
[residuals]
The residual is white: 4 % of its autocorrelations lie outside ± 0.12. It follows the drive: 50 % of the cross-
  correlations lie outside; 5 % would be noise.
[tests]
# Parameters
# m0, in the mirror file
| -: parameter / value / ± standard error / unit / note [0, 3, 4]
weight at 0 V / 2 / 0.01 / mrad/V /
weight at 0.5 V / 3 / 0.02 / mrad/V /
The weights are a non-negative least-squares problem, which has one minimum: no starts are needed. Condition number
  12.5; the variances are inflated 3.25 times for the colour of the residual.
# m1, the choice
| -: parameter / value / ± standard error / unit / note [0, 3, 4]
weight at 0 V / −4 / 0.02 / mrad/V /
weight at 1 V / −3 / 0.02 / mrad/V /
The weights are a non-negative least-squares problem, which has one minimum: no starts are needed. Condition number
  25; the variances are inflated 6.5 times for the colour of the residual.
# All models
A reason.
| -: residual in % of the peak-to-peak output, 250 µrad / fitted, rms / fitted, peak / unseen, rms / unseen, peak /
  unseen, rms / admissible [0, 6] best [0] brief [0, 1, 2, 3, 4]
m1 (chosen) / 1.375 / 3.50 / 1.500 / 5.50 / 3.75 µrad / yes
straight line / 7.500 / 8.50 / 2.000 / 9.50 / 5 µrad /
m0 / 1.500 / 4.50 / 2.500 / 6.50 / 6.25 µrad / yes
""")


PICTURES = ("excitation", "loops", "residuals", "tests", "response", "poles")


def test_a_linear_part_stands_with_its_orders_poles_and_gains():
    scan = [
        ns(
            order=k,
            parameters=2 * k + 1,
            chi_square=100.0 / k,
            freedom=40 * (k - 2),
            criterion=1234.567 * k,
            output_error_rms=1.25e-6 / k,
        )
        for k in (2, 3)
    ]
    linear = ns(**{**vars(rich_linear()), "scan": scan})
    assert outline(identification_page._linear(a_found(linear=linear), {"poles": ns(name="poles")})) == one_text("""
# Linear part
# Order
The knee of the criterion.
| -: order / parameters / chi-square per degree of freedom / criterion / output error (rms) /  [5] brief [0, 1, 3,
  5]
2 / 5 / 50 / 2469.1 / 0.625 µrad /
3 / 7 / 0.8333 / 3703.7 / 0.4167 µrad / chosen
# Poles, zeros and gains
[poles]
| -:  / natural frequency / ± / damping ratio / ± / excited /  [0, 5, 6] brief [0, 1, 2, 3, 5]
pole pair / 5 Hz / 0.25 Hz / 0.6 / 0.05 / yes /
pole, real / 12 Hz / 0.5 Hz / 1 /  / yes /
zero, real / 40 Hz / 1.5 Hz / −1 /  / no / extrapolated
gain at zero frequency / 5 mrad/V / 0.4 mrad/V /  /  / no / extrapolated
gain at 2 Hz / 4.5 mrad/V / 0.2 mrad/V /  /  / yes /
""")


def test_the_origin_of_a_page_names_the_mirror_file_and_each_recording_with_its_digest(monkeypatch):
    monkeypatch.setattr(identification_page, "versions", lambda: {"microrad": "1.2", "numpy": "3.4"})
    view = identification_page._origin(a_found(), Path("lab.toml"), "text = 1\nmore = 2\n", "m0")
    assert outline(view) == one_text("""
# Mirror file and origin
lab.toml holds m0:
text = 1
more = 2
| -: recording / SHA-256 [0, 1]
a/r0.csv / 0f
b/r1.csv / 1f
c/r2.csv / 2f
Mirror file SHA-256 fc18b6646c484fbbe7f55bc4bf0f57289d4c6b25a1da10803edbbb15b2e55035. Every number above is computed
  from these recordings. Standard errors come from the residuals of the fitted samples.
Made with microrad 1.2, numpy 3.4.
""")


def test_a_page_without_warnings_refusals_findings_or_pictures_says_so(monkeypatch):
    monkeypatch.setattr(identification_page.words, "warnings", lambda found, written: [])
    found = a_found(refused=[])
    for each in found.recordings:
        each.findings = []
    views = identification_page._views(found, "m1")
    assert outline(views[0], views[4]) == one_text("""
# Warnings and refusals
- No warnings.
# Time response
""")
    assert outline(views[1]).split("\n")[-1] == "The checks of the recordings noticed nothing."
    assert [view.folded for view in views[6].views] == [True, False]
    assert [view.title for view in views[6].views] == ["m0", "m1, the choice, in the mirror file"]


@pytest.mark.parametrize(
    ("drive", "volts", "rate_hz", "said"),
    [
        (3.0 + 2.0 * np.sin(2 * np.pi * np.arange(64) / 16.0), 1.0, 1600.0, "100 Hz, ± 2 V about 3 V"),
        (3.0 + 2.0 * np.sin(2 * np.pi * np.arange(64) / 16.0), 10.0, 800.0, "50 Hz, ± 20 V about 30 V"),
        (2.0 * np.sin(2 * np.pi * np.arange(64) / 16.0) - 5.0, 1.0, 1600.0, "100 Hz, ± 2 V about −5 V"),
        (1e3 * np.sin(2 * np.pi * np.arange(64) / 16.0), 1.0, 1600.0, "100 Hz, ± 1000 V about 0 V"),
        (np.arange(32.0) ** 3 % 17, 0.001, 8.0, "many frequencies, ± 0.008 V about 0.008 V"),
        (np.zeros(16), 1.0, 8.0, "many frequencies, ± 0 V about 0 V"),
    ],
)
def test_a_drive_is_told_in_volts_whatever_unit_its_file_has(drive, volts, rate_hz, said):
    assert words.drive_text(ns(drive=drive[:, None], rate_hz=rate_hz), volts) == said


def test_numbers_of_an_identification_have_minus_signs_and_no_powers_of_ten():
    found = ns(drive_min_v=-6.0, drive_max_v=6.0)
    assert words.drive_range(found) == ("−6 V", "6 V")
    assert identification_page._angle(1.234e-3) == "1230 µrad"
    order = ns(order=2, parameters=5, chi_square=123456.0, freedom=1, criterion=-123456.7, output_error_rms=1.23456e-2)
    (row,) = identification_page._scan(ns(scan=[order], order=2)).rows
    assert row == ("2", "5", "123500", "−123460", "12350 µrad", "chosen")


def test_a_settled_hysteresis_with_a_large_error_has_no_power_of_ten():
    fit = made(
        BoucWenFit,
        model=BoucWen(1e-3, 2e-6, 3e-2, 4e-5, 5.0, 1.5, rate_limit_v_s=700.0),
        covariance=4.0 * np.diag([1e-10, 4e-14, 9e-12, 1e-12, 1e-2, 4e-4]),
        not_identified=(),
        agreeing_starts=3,
        start_rms_percent=(1.0, 2.0, 3.0, 4.0),
        condition_number=450.0,
        colour_inflation=1.75,
    )
    *_, said, _ = parameters.notes(fit)
    assert said.endswith("= 4620 ± 140 µrad.")


def test_an_order_with_a_pole_that_no_recording_shows_has_no_criterion():
    of = {"order": 2, "parameters": 5, "chi_square": 20.0, "freedom": 40, "output_error_rms": 1e-6}
    score = SimpleNamespace(**of, criterion=1e12 + 30.0)
    (row,) = identification_page._scan(SimpleNamespace(scan=(score,), order=1)).rows
    assert row == ("2", "5", "0.5", "", "1 µrad", "has a pole that no recording shows")


@pytest.mark.parametrize("chirps", [(), ("b", "c")])
def test_the_fit_of_the_title_is_that_of_the_first_chirp_of_those_that_are_drawn(monkeypatch, chirps):
    given = [ns(path=f"{name}.csv", sha256=name, samples=100, period_samples=None) for name in "abcdev"]
    fits = {"a": 81.5, "b": 92.25, "c": 63.0}
    drawn = []

    def panels(places, recording, found, linear, seen):
        drawn.append((recording.sha256, [(p.row, p.column, p.columns) for p in places], seen))
        return fits[recording.sha256]

    def sorted_by(recordings):
        assert [r.sha256 for r in recordings] == [*"abcde"]  # what served for validation was not fitted
        return Roles([given[1]], given[:4], given[4:5])

    monkeypatch.setattr(figures, "roles", sorted_by)
    monkeypatch.setattr(figures, "_response_panels", panels)
    monkeypatch.setattr(figures, "is_chirp", lambda recording: recording.sha256 in chirps)
    sources = [ns(path="v.csv", sha256="v", role="validation"), ns(path="a.csv", sha256="other", role="validation")]
    figure = figures.time_response(ns(linear=ns(order=7), sources=sources, recordings=()), given)
    unseen = "unseen by the linear model"
    assert drawn == [
        ("a", [(0, 0, 2), (1, 0, 1), (1, 1, 1)], unseen),
        ("b", [(2, 0, 2), (3, 0, 1), (3, 1, 1)], "fitted"),
        ("c", [(4, 0, 2), (5, 0, 1), (5, 1, 1)], unseen),
    ]
    said = "Time response to the chirp, fit 92.25 %" if chirps else "Time response of the linear part, fit 81.50 %"
    assert figure.title == said
    assert figure.caption.startswith("Output of the broadband recordings and of the linear model of order 7.")
    assert (figure.sheet.height, figure.sheet.heights) == (12.5, (1.0,) * 6)


@pytest.mark.parametrize("chirped", [False, True])
def test_a_time_response_starts_at_rest_and_shows_its_beginning_and_its_last_fifth(monkeypatch, chirped):
    """The error of the model is shorter than the record, and drive and output are in units of their own."""
    count, kept, rate_hz = 2000, 1600, 50.0
    drive = 3.0 + np.r_[0.0, philox(5).standard_normal(count - 1)]
    output = 0.5 * drive + 4.0
    recording = recording_from_arrays(drive, output, rate_hz, "/there/some chirp.csv")
    error = 1e-6 * np.where(np.arange(kept) % 2, 0.25, -0.25)[:, None]
    seen = []

    def left(modes, scaled, hold):
        seen.append((modes, hold, scaled))
        return error

    monkeypatch.setattr(figures, "axis_error", left)
    monkeypatch.setattr(figures, "is_chirp", lambda one: chirped)
    found = ns(units=ns(volts=10.0, radians=2e-6))
    panels = [Panel(0, 0) for _ in range(3)]
    fit = figures._response_panels(panels, recording, found, ns(modes="modes", hold="first-order"), "fitted")
    ((modes, hold, scaled),) = seen
    assert (modes, hold) == ("modes", "first-order")
    np.testing.assert_allclose(scaled.drive[:, 0], 10.0 * (drive - 3.0))
    y = 2e-6 * (output[:kept] - output[:kept].mean())
    percent = 100.0 * (1.0 - np.linalg.norm(error[:, 0]) / np.linalg.norm(y))
    assert fit == pytest.approx(percent, rel=1e-9)  # sums in another order
    whole, early, late = panels
    assert whole.title == f"some chirp.csv: fit {percent:.2f} % (fitted)"
    time, e = np.arange(kept) / rate_hz, error[:, 0]
    first = slice(0, 400 if chirped else 300)
    for panel, curves in (
        (whole, [(time, y, "measured", BLUE), (time, e, "measured less modelled", ORANGE)]),
        (early, [(time[first], y[first], "measured", BLUE), (time[first], (y - e)[first], "linear model", VERMILION)]),
        (
            late,
            [
                (time[1280:1580], y[1280:1580], "measured", BLUE),
                (time[1280:1580], (y - e)[1280:1580], "linear model", VERMILION),
            ],
        ),
    ):
        lines = panel.all_of(Line)
        assert [(line.label, line.colour) for line in lines] == [curve[2:] for curve in curves]
        for line, (x, values, *_) in zip(lines, curves, strict=True):
            np.testing.assert_allclose(line.x, x)
            np.testing.assert_allclose(line.y, 1e6 * values, atol=1e-9)
        assert (panel.x.title, panel.y.title) == ("time (s)", "output (µrad)")
    assert (whole.legend is None, early.legend is None, late.legend) == (False, False, None)


def test_each_figure_counts_the_recordings_that_it_leaves_out_of_its_own_only():
    one, other = two_recordings()
    unjudged = replace(one, prediction=None, role="broadband")
    everything = [unjudged, *[one, other] * 7, unjudged]  # fourteen with a prediction, sixteen in all
    found = ns(chosen="linear", linear=None)
    for figure, count, panels in (
        (figures.loops(everything, found), 2, 24),
        (figures.residuals(everything), 2, 12),
        (figures.excitation(everything, found), 4, 24),
    ):
        assert figure.caption.endswith(f". {count} more recordings are not drawn.")
        assert len(figure.sheet.panels) == panels
    assert not figures.loops(everything[:13], found).caption.endswith("not drawn.")


@pytest.mark.parametrize(
    ("there", "overwrite", "said"),
    [
        (BEGINS + "first", False, r"r\.html exists and is left as it is; name another file, or replace it with --over"),
        ("mine", True, r"r\.html is not a report that microrad identify wrote and is left as it is; name another file"),
    ],
)
def test_a_file_that_appears_while_the_page_is_made_is_left_alone(monkeypatch, tmp_path, there, overwrite, said):
    target = tmp_path / "r.html"

    def page(found, **given):
        target.write_text(there, encoding="utf-8")
        return BEGINS + "new"

    monkeypatch.setattr(identification_page, "identification_page", page)
    given = {"mirror_file": Path("m.toml"), "mirror_text": "", "title": "T", "overwrite": overwrite}
    with pytest.raises(report.ReportError, match=said):
        report.write_identification(ns(chosen="linear"), target, **given)
    assert text_of(target) == there


def test_a_link_to_nothing_is_no_report_and_is_not_followed(monkeypatch, tmp_path):
    target = tmp_path / "r.html"
    try:
        target.symlink_to(tmp_path / "nothing.html")
    except OSError:
        pytest.skip("links cannot be made here")
    with pytest.raises(report.ReportError, match=r"r\.html is not a report that microrad identify wrote"):
        identification_page.check_identification(target, True)
    assert target.is_symlink() and not (tmp_path / "nothing.html").exists()


@pytest.mark.parametrize("written", [None, "bouc_wen"])
def test_a_page_is_made_of_all_that_is_given_with_the_choice_where_no_model_is_named(monkeypatch, tmp_path, written):
    seen, found = [], ns(chosen="linear")

    def page(found, **given):
        seen.append((found, given))
        return BEGINS + "new"

    monkeypatch.setattr(identification_page, "identification_page", page)
    given = {"mirror_file": Path("m.toml"), "mirror_text": "text", "title": "A title"}
    more = {"recordings": ("one", "two"), "virtual": True} if written else {}
    path = report.write_identification(found, tmp_path / "r.html", **given, written=written, **more)
    assert (path, text_of(path)) == (tmp_path / "r.html", BEGINS + "new")
    all_of_it = {"written": "linear", "recordings": (), "virtual": False, **more}
    assert seen == [(found, given | all_of_it | ({"written": written} if written else {}))]


def test_a_phase_is_found_where_the_model_is_nothing():
    (size, phase), freq = (Panel(0, 0), Panel(1, 0)), np.array([1.0, 10.0, 100.0])
    model = figures.Modelled(freq, np.array([1.0, 0.0, -1.0], dtype=complex), "a model")
    figures.bode((size, phase), figures.Measured(freq, np.array([1.0, 2.0j, -1.0])), model)
    measured, modelled = phase.all_of(Line)
    np.testing.assert_allclose([measured.y, modelled.y], [[0.0, 90.0, 180.0], [0.0, 0.0, 180.0]], atol=1e-9)
    assert (phase.y.low, phase.y.high) == (pytest.approx(-20.0), pytest.approx(200.0))
    np.testing.assert_allclose([line.y for line in size.all_of(Line)], [[1.0, 2.0, 1.0], [1.0, 0.0, 1.0]])


def test_a_recording_is_known_by_its_file_and_its_bytes():
    kept = [ns(path="a.csv", sha256="1"), ns(path="b.csv", sha256="2")]
    changed, moved = ns(path="a.csv", sha256="3"), ns(path="c.csv", sha256="2")
    again = ns(path="b.csv", sha256="2")
    assert words.shown_recordings(ns(recordings=kept), [changed, again, moved]) == [changed, moved]


def test_warnings_are_those_of_the_model_that_is_written_each_once_and_without_its_range_where_the_verdict_has_it(
    monkeypatch,
):
    monkeypatch.setattr(words, "fit_warnings", lambda fit: [f"of {fit}", "short"])
    monkeypatch.setattr(words, "range_warnings", lambda drives, rate: [f"from {drives} at {rate}"])
    found = ns(
        warnings=("short", "from (-1.0, 4.0) at 7.0", "of linear"),
        fit=lambda model: model or "linear",
        drive_min_v=-1.0,
        drive_max_v=4.0,
        rate_limit_v_per_s=7.0,
    )
    assert words.warnings(found) == ["short", "from (-1.0, 4.0) at 7.0", "of linear"]
    assert words.warnings(found, "plays") == ["short", "from (-1.0, 4.0) at 7.0", "of linear", "of plays"]
    assert words.pressing(found, "plays") == ["short", "of linear", "of plays"]


def test_a_terminal_has_seven_rows_of_poles_and_the_delay_without_notes(monkeypatch):
    names = ["alpha", *(f"pole {k}" for k in range(1, 7)), "delay", "pole 7", "zero 1"]
    rows = [(name, f"{k}", f"{k}.5", "Hz", "a note") for k, name in enumerate(names)]
    made_of = []

    def model(fit):
        made_of.append(fit)
        return Table("", ("parameter", "value", "± standard error", "unit", "note"), rows, (0, 3, 4))

    monkeypatch.setattr(identification_page, "_model", model)
    (table,) = identification_page._poles(ns(fit=lambda written: written), "bouc_wen")
    assert made_of == ["bouc_wen"]
    assert [tuple(map(str, row)) for row in table.rows] == [row[:4] for row in rows[1:8]]
    assert [*table.headings] == ["parameter", "value", "± standard error", "unit"]
    rows[1:9] = []
    assert identification_page._poles(ns(fit=lambda written: written), "bouc_wen") == []


def test_the_axis_of_poles_holds_the_lowest_and_the_highest_of_poles_zeros_and_band():
    for poles, zeros, ends in (([-15.0, -30.0], [2.0], (0.6, 90.0)), ([-3.0, -15.0], [12.0, 50.0], (0.9, 150.0))):
        linear = a_linear(np.array(poles) + 0j, [1.0, 2.0], np.array(zeros) + 0j)
        (panel,) = figures.poles(linear).sheet.panels
        assert (panel.x.low, panel.x.high) == (pytest.approx(ends[0]), pytest.approx(ends[1]))


def test_recordings_are_drawn_in_volts_and_radians_with_what_each_served_for():
    """Two that were judged, then those that were given besides, of which one served for nothing."""

    def recording(path, sha256, scale):
        drive = scale * np.array([[0.0], [1.0], [-1.0], [3.0]])
        return ns(path=path, sha256=sha256, drive=drive, output=7.0 * drive, rate_hz=2.0 * scale)

    one, two = recording("/in/one.csv", "1", 1.0), recording("/in/two.csv", "2", 2.0)
    wide, other = recording("/in/wide.csv", "3", 4.0), recording("/in/one.csv", "9", 8.0)
    roles = {("/in/two.csv", "2"): "validation", ("/in/one.csv", "1"): "loops", ("/in/wide.csv", "3"): "broadband"}
    found = ns(
        units=ns(volts=10.0, radians=1e-6),
        recordings=[one, two],
        scores=[ns(model="plays"), ns(model="linear")],
        predictions=[("not", "these"), ("first", "second")],
        chosen="linear",
        sources=[ns(path=path, sha256=sha256, role=role) for (path, sha256), role in roles.items()],
    )
    made = figures.shown(found, [wide, two, other])
    assert [(each.name, each.role, each.prediction, each.rate_hz) for each in made] == [
        ("one.csv", "loops", "first", 2.0),
        ("two.csv", "validation", "second", 4.0),
        ("wide.csv", "broadband", None, 8.0),
        ("one.csv", "not used", None, 16.0),
    ]
    assert [each.drive_v.tolist() for each in made] == [[0.0, 10.0 * k, -10.0 * k, 30.0 * k] for k in (1, 2, 4, 8)]
    np.testing.assert_allclose(made[1].output_rad, 14e-6 * np.array([0.0, 1.0, -1.0, 3.0]))
    assert made[2].time_s.tolist() == [0.0, 0.125, 0.25, 0.375]


@pytest.mark.parametrize(
    ("fitted", "period", "drawn_with"),
    [("b", 160, (160, None)), ("b", 150, (150, 150)), ("ab", 160, (160, 160))],
)
def test_the_one_fitted_recording_of_less_than_two_periods_is_drawn_as_one_without_a_period(
    monkeypatch, fitted, period, drawn_with
):
    values = philox(3).standard_normal(300)
    given = [replace(recording_from_arrays(values, values, 50.0, f"{name}.csv", period), sha256=name) for name in "ab"]
    drawn = []

    def panels(places, recording, found, linear, seen):
        drawn.append(recording.period_samples)
        return 90.0

    monkeypatch.setattr(figures, "roles", lambda these: Roles([r for r in given if r.sha256 in fitted], given, given))
    monkeypatch.setattr(figures, "_response_panels", panels)
    figures.time_response(ns(linear=ns(order=7), sources=[], recordings=()), given)
    assert tuple(drawn) == drawn_with


def test_one_start_of_three_may_reach_the_best_fit():
    fit = made(BoucWenFit, agreeing_starts=1, start_rms_percent=(1.0, 2.0, 3.0))
    assert starts_text(fit) == "1 of 3 starts reached the best fit"
    alone = made(BoucWenFit, agreeing_starts=1, start_rms_percent=(1.0,))
    assert starts_text(alone) == "one start was made, from the least-squares weights of the operators"


@pytest.mark.parametrize("samples", [2047, 2048, 3071, 3072, 9000])
def test_the_spectrum_of_a_residual_is_the_mean_over_half_overlapping_segments(samples):
    values = 3.0 + philox(samples).standard_normal(samples).cumsum()
    freq, density = figures._spectrum(values, 500.0)
    known, expected = welch(values, 500.0, nperseg=min(samples, 2048))
    np.testing.assert_allclose(freq, known)
    np.testing.assert_allclose(density, expected, rtol=1e-6, atol=1e-9 * expected.max())  # sums in another order


def test_why_an_order_was_chosen_begins_with_a_capital_and_keeps_its_names(monkeypatch):
    for made_of in ("_scan", "_roots"):
        monkeypatch.setattr(identification_page, made_of, lambda linear: None)
    view = identification_page._linear(ns(linear=ns(reason="order 4 has the lowest BIC of Hankel matrices")), {})
    assert outline(view) == one_text("""
# Linear part
# Order
Order 4 has the lowest BIC of Hankel matrices.
# Poles, zeros and gains
""")


def test_the_verdict_ends_with_the_error_of_the_model_that_is_written_in_place_of_the_choice(full):
    own, error = words.verdict(full), words.error_text(full.score("linear"), full.span_rad)
    said = f"The mirror file holds linear as asked, which leaves {error}."
    assert full.chosen != "linear" and "as asked" not in " ".join(own)
    assert words.verdict(full, "linear") == [*own, said]
    assert words.verdict(full, full.chosen) == own
    assert words.brief_verdict(full, "linear") == [*words.brief_verdict(full, full.chosen), said]
    for written in ("linear", full.chosen):
        lead = identification_page._lead(full, written)
        assert (lead.headline, said in str(lead.blocks)) == (own[0], written == "linear")


def test_held_roots_have_a_damping_unless_they_are_real_and_fitted_ones_are_not_held():
    """Real ones on either side of the axis: their damping is 1 or -1."""
    fit = ns(
        structure=ns(parameters=[ns(name="pole 2"), ns(name="zero 1"), ns(name="gain")]),
        linear=ns(
            poles=ns(frequencies_hz=(10.0, 20.0, 30.0, 40.0), dampings=(1.0, 0.1, -1.0, 0.25)),
            zeros=ns(frequencies_hz=(5.0, 7.0, 9.0), dampings=(0.5, -1.0, -0.125)),
        ),
        creep=ns(time_constants_s=(0.5, 20.0)),
    )
    lags = [("creep lag 1", 0.5, "s", "chosen"), ("creep lag 2", 20.0, "s", "chosen")]
    note = "held, from the frequency response"
    rows = parameters._held(fit)
    assert [(row.name, row.value, row.unit, row.note) for row in rows] == [
        ("pole 1", 10.0, "Hz", note),
        ("pole 3", 30.0, "Hz", note),
        ("pole 4", 40.0, "Hz", note),
        ("pole 4 damping", 0.25, "", note),
        ("zero 2", 7.0, "Hz", note),
        ("zero 3", 9.0, "Hz", note),
        ("zero 3 damping", -0.125, "", note),
        *lags,
    ]
    assert all(math.isnan(row.standard_error) for row in rows)
    fit.linear = None
    assert [(row.name, row.value, row.unit, row.note) for row in parameters._held(fit)] == lags


@pytest.mark.parametrize(
    ("low", "high", "said"),
    [
        (-1.0, 0.123456, ("−1 V", "0.123 V")),
        (-0.123456, 1.0, ("−0.123 V", "1 V")),
        (0.0123456, 50.0, ("0.01 V", "50 V")),
        (99.996, 100.00849, ("100 V", "100 V")),
        (-7.23456, -0.0004, ("−7.235 V", "0 V")),
    ],
)
def test_both_ends_of_a_drive_are_told_to_a_thousandth_of_the_range_between_them(low, high, said):
    assert words.drive_range(SimpleNamespace(drive_min_v=low, drive_max_v=high)) == said


def test_what_presses_has_neither_the_drives_nor_the_rates_that_the_verdict_has(monkeypatch):
    monkeypatch.setattr(words, "warnings", lambda found, written: [*known, f"of {written}"])
    found = SimpleNamespace(drive_min_v=-1.0, drive_max_v=3.0, rate_limit_v_per_s=500.0)
    known = words.range_warnings((-1.0, 3.0), 500.0)
    assert len(known) == 2 and words.pressing(found, "plays") == ["of plays"]
    found.rate_limit_v_per_s = 400.0
    assert words.pressing(found, "plays") == [known[1], "of plays"]


def test_an_error_larger_than_its_frequency_ends_above_zero_on_the_logarithmic_axis():
    linear = a_linear([-9.0 + 12.0j, -15.5 + 0j], [40.0, 2.0])
    (panel,) = figures.poles(linear).sheet.panels
    (line,) = panel.all_of(Line)
    assert line.x == pytest.approx([15.0, 15.5])
    np.testing.assert_allclose(line.x_arms, [[13.5, 2.0], [40.0, 2.0]])
    np.testing.assert_allclose(line.y_arms, [[40.0 / 15.0, 0.0]] * 2)


def test_a_drive_about_a_bias_has_as_many_swings_drawn_as_one_about_zero():
    t = np.arange(3000) / 1000.0
    drive = np.sin(2 * np.pi * 30 * t) + 0.5 * np.sin(2 * np.pi * 90 * t + 1.0)
    plain, biased, below = (figures._stretch(shown_of(drive + bias), slice(500, 3000)) for bias in (0.0, 7.0, -7.0))
    assert plain == biased == below and plain.stop == 3000 and 2200 < plain.start < 2500


def test_a_chirp_crosses_the_middle_between_its_ends_and_a_spike_moves_that():
    drive = chirp().drive[:, 0].copy()
    assert figures.is_chirp(recording_from_arrays(drive, drive, RATE_HZ, "chirp"))
    drive[drive.size // 2] += 4.0 * np.ptp(drive)
    assert not figures.is_chirp(recording_from_arrays(drive, drive, RATE_HZ, "spike"))


@pytest.mark.parametrize(("count", "rows", "columns"), [(1, 1, 1), (2, 1, 2), (3, 2, 2), (5, 3, 2)])
def test_residuals_of_one_recording_have_the_whole_width_and_of_several_stand_two_by_two(count, rows, columns):
    one = next(each for each in two_recordings() if each.prediction is not None)
    sheet = figures.residuals([one] * count).sheet
    assert (len(sheet.heights), len(sheet.widths), sheet.height) == (rows, columns, pytest.approx(0.5 + 1.9 * rows))
    assert [(panel.row, panel.column) for panel in sheet.panels] == [divmod(k, columns) for k in range(count)]
