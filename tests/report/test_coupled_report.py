"""The report of an identification of several channels: the same numbers in terminal, page and JSON, and all are said.

Its record is made by hand: two actuators, two outputs, two amplitudes; responses are those of simulated multisines.
"""

import html
import json
import re
from dataclasses import replace
from functools import cache
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from drawn import lines_of, one_text, outline
from microrad import report
from microrad.lab.identify.coupled import Candidate, CoupledIdentification
from microrad.lab.identify.linear.amplitude import AmplitudeDependence
from microrad.lab.identify.linear.response import response_from_periods
from microrad.lab.identify.selection.candidates import Refused
from microrad.lab.recording import Recording
from microrad.mirror.coupled import Actuator, CoupledMirror, Known, Output
from microrad.mirror.model import Mirror
from microrad.report.identification import coupled as coupled_page
from microrad.report.identification import coupled_figures as coupled_figures_module
from microrad.report.identification import coupled_words as words
from microrad.report.identification.coupled_figures import MOST, bands, coupled_figures, error_over_parameters
from microrad.report.identification.page import BEGINS
from microrad.report.identification.terminal import MOST_LINES
from microrad.report.plotting.sheet import Area, Line, Rule, Span
from microrad.report.tables import Cell
from microrad.report.view import views_text
from report_pages import assert_sound, without_scripts

RATE_HZ, PERIOD = 1000.0, 256
BANDS_HZ = np.array([3.9, 40.0, 1234.0])
OUTPUT_RMS = np.array([[1.0e-6, 2.0e-6], [2.0e-6, 4.0e-6]])
NOISE_RMS = np.array([[1.0e-8, 2.0e-8], [1.0e-8, 2.0e-8]])
HELD_OUT = ("small <3>.npy", "large <3>.npy")
HOSTILE = "<b>sensor</b>"


def philox(seed):
    return np.random.Generator(np.random.Philox(seed))


def plant():
    """A pair at 79.6 Hz and a real pole, micrometres from volts."""
    A = np.array([[-20.0, -500.0, 0.0], [500.0, -20.0, 0.0], [0.0, 0.0, -900.0]])
    B = np.array([[0.0, 0.0], [400.0, 300.0], [500.0, -600.0]])
    C = 1e-6 * np.array([[1.0, 0.2, 1.0], [0.7, 0.1, -1.0]])
    none = np.zeros((3, 0)), np.zeros((0, 3)), np.zeros((0, 2)), np.zeros((2, 0))
    return Mirror("mirror", A, B, none[0], none[1], none[2], C, np.zeros((2, 2)), none[3], (), (), ())


@cache
def coupled(quantity="displacement", known=None):
    """The plant with its channels."""
    return CoupledMirror(
        plant(),
        (Actuator("piezo 1", 5.0, 4.25, 5.75, 1.5e4), Actuator("piezo 2", 4.0, 3.5, 4.5, 1e4)),
        (Output(HOSTILE, quantity), Output("y1", quantity)),
        2e-4,
        RATE_HZ,
        2,
        (3.9, 400.0),
        known,
    )


@cache
def responses(scale):
    """Measured and modelled response at an amplitude, and the records behind it: three realisations of two periods."""
    measured, modelled = [], []
    for seed in range(3):
        phases = philox(seed).uniform(0, 2 * np.pi, (102, 2))
        spectrum = np.zeros((PERIOD // 2 + 1, 2), dtype=complex)
        spectrum[1:103] = np.exp(1j * phases)
        drive = np.fft.irfft(spectrum, PERIOD, axis=0)
        drive = np.tile(scale * drive / drive.std(axis=0), (2, 1))
        model = coupled().response(np.concatenate([drive[:PERIOD], drive]))[PERIOD:]
        noise = 1e-8 * philox(100 + seed).standard_normal(model.shape)
        names = ("piezo 1", "piezo 2"), (HOSTILE, "y1")
        record = Recording(f"{scale:g} V, {seed}", "", drive, 1.02 * model + noise, RATE_HZ, *names, PERIOD)
        measured.append(record)
        modelled.append(replace(record, output=model))
    return response_from_periods(measured), response_from_periods(modelled).response


def candidate(name, kind, parameters, share, error=None, **more):
    """A candidate with this error over the output everywhere, unless told otherwise."""
    errors = share * OUTPUT_RMS if error is None else error
    return Candidate(
        name=name,
        kind=kind,
        order=3,
        parameters=parameters,
        model=coupled(),
        poles_rad_s=np.array([-20.0 + 500.0j, -900.0 + 0.0j]),
        poles_error_rad_s=np.array([1.0 + 2.0j, 30.0 + 0.0j]),
        delay_error_s=5e-6,
        error_rms=errors,
        band_error_rms=np.stack([0.6 * errors, 0.8 * errors], axis=1),
        error_share=share,
        record_share=np.array([[0.9 * share, 1.1 * share], [share, share]]),
        **more,
    )


def found_of(**changes):
    """The identification, with some of its fields changed."""
    small, large = responses(0.1), responses(0.2)
    given = {
        "candidates": (
            candidate("per axis, order 2", "per axis", 11, 0.523),
            candidate("coupled linear, order 3", "coupled linear", 17, 0.2171, note="its search had not settled"),
            candidate("hysteretic stiffness, order 3", "hysteretic stiffness", 47, 0.0523),
            candidate("hysteretic stiffness, order 5", "hysteretic stiffness", 81, 0.0517),
        ),
        "chosen": "hysteretic stiffness, order 3",
        "reason": "the smaller of two whose difference may be chance.",
        "within_noise": ("hysteretic stiffness, order 3", "hysteretic stiffness, order 5"),
        "warnings": ("Output y1 drifts.", "Few realisations."),
        "refused": (Refused("hysteretic stiffness, order 9", "the fitted mirror <runs> away"),),
        "amplitudes_v": np.array([0.1, 0.2]),
        "bands_hz": BANDS_HZ,
        "output_rms": OUTPUT_RMS,
        "noise_rms": NOISE_RMS,
        "responses": (small[0], large[0]),
        "modelled": (small[1], large[1]),
        "dependence": AmplitudeDependence(
            np.array([0.1, 0.2]),
            np.array([2.0e-6, 2.104e-6]),
            np.array([79.58, 78.2]),
            np.array([0.2, 0.1]),
            np.full(2, 0.04),
        ),
        "fitted": ("small 0", "small 1", "small 2", "large 0", "large 1", "large 2"),
        "held_out": HELD_OUT,
        "stopped": False,
    }
    return CoupledIdentification(**given | changes)


def page_of(found, folder, name="found.html", **options):
    given = {"mirror_file": Path("lab.toml"), "mirror_text": "version = 2\n", "title": "A mirror"}
    return report.write_coupled_identification(found, folder / name, **given | options)


def one_line(text):
    return re.sub(r"\s+", " ", text)


def plain(page):
    """What a page says, without its tags."""
    return one_line(html.unescape(re.sub(r"<[^>]*>", " ", without_scripts(page))))


@pytest.fixture(scope="module")
def found():
    return found_of()


@pytest.fixture(scope="module")
def page(found, tmp_path_factory):
    return page_of(found, tmp_path_factory.mktemp("coupled")).read_text("utf-8")


@pytest.fixture(scope="module")
def text(found):
    return report.coupled_identification_text(found, 80, mirror_file=Path("lab.toml"), report_file=Path("lab.html"))


@pytest.fixture(scope="module")
def data(found):
    made = report.coupled_identification_data(found, mirror_file=Path("lab.toml"), report_file=Path("lab.html"))
    assert json.loads(json.dumps(made, allow_nan=False)) == made
    return made


def rows_of(page):
    """The cells of each table row of a page, as plain text."""
    rows = re.findall(r"<tr[^>]*>(.*?)</tr>", page, re.DOTALL)
    cells = (re.findall(r"<t[dh][^>]*>(.*?)</t[dh]>", row, re.DOTALL) for row in rows)
    return [[html.unescape(re.sub(r"<[^>]*>", "", cell)).strip() for cell in row] for row in cells]


def row_of(page, first):
    (row,) = [row for row in rows_of(page) if row and row[0] == first]
    return row


# ----------------------------------------------------------------------------------------------------- the same numbers
@pytest.mark.promise("identify-45", "identify-46")
def test_the_verdict_is_the_same_in_all_faces(found, page, text, data):
    headline, amplitudes, worst, rests, reason = words.verdict(found)
    assert headline == (
        "Hysteretic stiffness, order 3 (47 parameters) predicts 2 records that no fit has seen with an error of 5.23 % "
        "of the rms output."
    )
    assert amplitudes == (
        "It leaves 82.7 nm rms (5.23 % of the output) at 100 mV rms drive and 165 nm rms (5.23 % of the output) at "
        "200 mV rms drive."
    )
    assert worst == "The worst is y1 of small <3>.npy: 5.75 %."
    assert rests == "This rests on small <3>.npy and large <3>.npy; 6 other records were fitted."
    assert reason == "The smaller of two whose difference may be chance."
    assert data["verdict"] == [headline, amplitudes, worst, rests, reason]
    assert all(sentence in plain(page) for sentence in data["verdict"])
    assert headline in one_line(text) and worst in one_line(text)
    assert data["worst"] == {"record": "small <3>.npy", "output": "y1", "error_share": pytest.approx(0.05753)}


@pytest.mark.promise("identify-46")
@pytest.mark.parametrize("number", range(4))
def test_each_candidate_is_in_all_faces(found, page, text, data, number):
    own = found.candidates[number]
    error = ("52.3 %", "22 %", "5.23 %", "5.17 %")[number]
    said = ("", "", "chosen", "within noise")[number]
    assert row_of(page, own.name) == [own.name, str(own.parameters), error, error, error, said]
    (line,) = [line for line in text.splitlines() if line.strip().startswith(own.name)]
    assert line.split()[4:6] == [str(own.parameters), error.split()[0]]
    of = data["candidates"][number]
    assert of["note"] == ("its search had not settled" if number == 1 else "")
    assert "coupled linear, order 3: its search had not settled" in plain(page)
    assert (of["name"], of["kind"], of["parameters"]) == (own.name, own.kind, own.parameters)
    assert of["error_share"] == own.error_share
    assert of["error_rms_m"] == own.error_rms.tolist()
    assert of["error_share_by_amplitude"] == pytest.approx([own.error_share] * 2)
    assert of["record_error_share"] == dict(zip(HELD_OUT, own.record_share.tolist(), strict=True))


UNITS = re.compile(r"_(v|m|hz|s|m_v|v_s|rad|rad_v|rad_s)$")
WITHOUT_UNIT = re.compile(r"parameters|order|error_share|share|damping|number|count|records|_per_sample")


@pytest.mark.promise("identify-46")
def test_the_worst_output_is_that_with_the_largest_share_of_its_own_size(tmp_path):
    """Half of the smaller output is missing and a third of the larger one, which is more in metres."""
    sizes = np.array([[3e-6, 1e-6], [6e-6, 2e-6]])
    errors = sizes * np.array([1 / 3, 1 / 2])
    found = found_of(
        candidates=tuple(replace(each, error_rms=errors) for each in found_of().candidates), output_rms=sizes
    )
    rows = rows_of(page_of(found, tmp_path).read_text(encoding="utf-8"))
    assert [row[-1] for row in rows if row[0] in ("100 mV", "200 mV") and len(row) == 7] == ["y1, 50 %"] * 2


def test_the_key_of_a_number_ends_in_its_unit(data):
    def numbers(value, key):
        if isinstance(value, dict):
            return {k for name, each in value.items() for k in numbers(each, name if isinstance(name, str) else key)}
        if isinstance(value, list):
            return {k for each in value for k in numbers(each, key)}
        return {key} if isinstance(value, int | float) and not isinstance(value, bool) else set()

    found = numbers({k: v for k, v in data.items() if k != "candidates"}, "") | numbers(data["candidates"], "")
    assert {key for key in found if not UNITS.search(key) and not WITHOUT_UNIT.search(key)} == set(HELD_OUT)
    assert {"bands_hz", "error_rms_m", "delay_s", "rate_limit_v_s"} <= found


@pytest.mark.promise("identify-45", "identify-46")
def test_errors_by_amplitude_and_record_stand_beside_floor_and_noise(found, page, text, data):
    floor = words.linear_floor(found)
    linear = f"{1e9 * float(np.sqrt(np.mean(floor[0] ** 2))):.3g}"
    assert ["100 mV", "1580", "82.7", "5.23 %", linear, "15.8", f"{HOSTILE}, 5.23 %"] in rows_of(page)
    assert data["linear_floor_rms_m"] == floor.tolist()
    assert floor == pytest.approx(NOISE_RMS, rel=0.1)  # there is no distortion in it
    assert row_of(page, HELD_OUT[0]) == [HELD_OUT[0], "5.26 %", "4.71 %", "5.75 %"]
    assert re.search(rf"100 mV +82.7 +5.23 % +{linear} +", text)


@pytest.mark.promise("identify-45")
def test_poles_by_hand(found, page, data):
    pair, real = words.poles(found.candidate())
    size = np.hypot(20.0, 500.0)
    assert pair.freq_hz == pytest.approx(size / (2 * np.pi))
    assert pair.freq_error_hz == pytest.approx(np.hypot(20.0 * 1.0, 500.0 * 2.0) / size / (2 * np.pi))
    assert pair.damping == pytest.approx(20.0 / size)
    moved = [-p.real / abs(p) for p in (-21.0 + 500.0j, -20.0 + 502.0j)]
    assert pair.damping_error == pytest.approx(np.hypot(*(np.array(moved) - pair.damping)), rel=0.01)
    assert (real.freq_hz, real.damping, real.excited) == (pytest.approx(900.0 / (2 * np.pi)), 1.0, True)
    assert row_of(page, "pair") == ["pair", "79.64", "0.32", "0.04", "0.002", "yes", ""]
    assert row_of(page, "real pole")[1:5] == ["143.2", "4.8", "1", ""]
    assert data["candidates"][2]["poles"][0]["frequency_hz"] == pair.freq_hz


def test_a_pole_whose_error_is_not_known_has_its_digits():
    own = replace(found_of().candidate(), poles_error_rad_s=np.full(2, complex(np.nan, np.nan)))
    assert [pole.texts for pole in words.poles(own)] == [
        ("79.64", "not known", "0.03997", "not known"),
        ("143.2", "not known", "1", ""),
    ]
    assert words.pole_error_text(own.poles_error_rad_s).startswith("Standard errors that are not known")


@pytest.mark.promise("identify-45")
def test_range_delay_and_amplitude_dependence_are_said(page, data):
    assert row_of(page, "piezo 1") == ["piezo 1", "5 V", "4.25 V", "5.75 V", "15 kV/s"]
    assert "The drive acts 200 µs ± 5 µs late." in plain(page)
    assert data["actuators"][1]["rate_limit_v_s"] == 1e4 and data["delay_s"] == 2e-4
    assert "the gain changes by +5.2 % and the main resonance by \u22121.38 Hz" in plain(page)
    assert data["amplitude_dependence"]["gain_m_v"] == [2.0e-6, 2.104e-6]
    assert ["200 mV", "2.104", "78.2", "0.1", "0.04"] in rows_of(page)


@pytest.mark.promise("identify-45", "identify-47", "identify-50")
def test_what_the_mirror_file_does_not_hold_is_said(found, page, data):
    said = words.not_held(found)
    assert data["not_in_the_mirror_file"] == said and all(sentence in plain(page) for sentence in said)
    ways = "Which way round the channels are"
    begins = [sentence.split(":")[0] for sentence in said]
    assert begins == ["Creep", "Modes above 400 Hz", "A geometry", ways, "Uncertainty"]
    known = Known(("recording.delay",), np.array([5e-6]), np.ones((1, 1)))
    linear = replace(found.candidate("coupled linear, order 3"), model=coupled("angle", known))
    other = words.not_held(replace(found, candidates=(linear,), chosen=linear.name))
    assert [sentence.split(":")[0] for sentence in other] == [
        "Creep",
        "Modes above 400 Hz",
        "Hysteresis",
        ways,
    ]
    assert words.not_held(replace(found, candidates=(replace(linear, kind="per axis"),), chosen=linear.name)) == other


# --------------------------------------------------------------------------------------------------------- the terminal
@pytest.mark.promise("identify-46")
def test_the_terminal_is_short(text):
    lines = text.splitlines()
    assert len(lines) <= MOST_LINES == 23 and max(map(len, lines)) <= 80
    assert lines[-1] == "lab.toml written (hysteretic stiffness, order 3)."
    assert "- Output y1 drifts." in lines and "- Few realisations." in lines
    assert "- 1 refused model: see the report, or --json." in lines


@pytest.mark.promise("identify-46")
def test_the_terminal_is_short_however_much_there_is_to_say():
    many = tuple(
        candidate(f"coupled linear, order {n}", "coupled linear", 10 * n, 0.5 - 0.01 * n) for n in range(1, 30)
    )
    long = tuple(f"Warning {n}: {'it goes on and on, ' * 9}and ends." for n in range(1, 20))
    found = found_of(candidates=many, chosen=many[3].name, within_noise=(many[3].name,), warnings=long)
    files = {"mirror_file": Path("a" * 60 + ".toml"), "report_file": Path("b" * 60 + ".html")}
    lines = report.coupled_identification_text(found, 80, **files).splitlines()
    assert len(lines) <= MOST_LINES and max(map(len, lines)) <= 80
    (own,) = [line for line in lines if line.startswith(" coupled linear, order 4 ")]
    assert own.endswith("chosen")
    assert re.search(
        r"^- \d+ (more )?warnings and 1 refused model: see the report, or --json\.$", "\n".join(lines), re.M
    )
    assert sum(line.startswith(" coupled linear") for line in lines) == 2  # the best one, too


# ------------------------------------------------------------------------------------------------------------- the page
def test_the_page_is_sound_and_escapes_what_is_not_ours(page, found):
    assert_sound(page)
    assert HOSTILE not in without_scripts(page) and html.escape(HOSTILE) in page
    assert "http" not in re.sub(r"http://www\.w3\.org/\S+", "", without_scripts(page))
    assert len(page) < 2_500_000
    assert page.startswith('<!DOCTYPE html>\n<html lang="en" data-made-by="microrad identify">')


def test_refused_models_have_their_reasons(page, data):
    assert "hysteretic stiffness, order 9: the fitted mirror <runs> away" in plain(page)
    assert data["refused"] == {"hysteretic stiffness, order 9": "the fitted mirror <runs> away"}


@pytest.mark.promise("identify-44")
def test_a_ladder_that_was_stopped_says_so(tmp_path):
    found = found_of(stopped=True)
    begins = (
        "Stopped before the last model, so the choice so far: hysteretic stiffness, order 3 (47 parameters) predicts"
    )
    assert words.headline(found).startswith(begins)
    assert begins in one_line(report.coupled_identification_text(found))
    assert report.coupled_identification_data(found)["stopped"] is True
    written = page_of(found, tmp_path).read_text("utf-8")
    assert begins in plain(written) and "The ladder was stopped before its last model" in plain(written)
    none = page_of(found_of(stopped=True, dependence=None), tmp_path, "none.html").read_text("utf-8")
    assert "The ladder was stopped before gain and resonance were compared" in plain(none)
    assert words.sound(found) is None and words.sound(found_of()) is True
    assert 'class="verdict pass"' not in written


def test_a_model_that_leaves_most_of_the_output_is_no_good_news():
    assert words.sound(found_of(chosen="per axis, order 2")) is False


def test_a_report_is_replaced_only_where_it_is_asked_for(found, tmp_path):
    target = page_of(found, tmp_path)
    with pytest.raises(report.ReportError, match=r"found\.html exists and is left as it is.*--overwrite"):
        page_of(found, tmp_path)
    assert page_of(found, tmp_path, overwrite=True, title="Another").read_text("utf-8").count("<h1>Another</h1>") == 1
    target.write_text("mine")
    with pytest.raises(report.ReportError, match="not a report that microrad identify wrote"):
        page_of(found, tmp_path, overwrite=True)
    assert target.read_text() == "mine"


# ---------------------------------------------------------------------------------------------------------- the figures
def test_every_axis_has_its_unit_and_no_panel_is_empty(found):
    figures = coupled_figures(found)
    assert list(figures) == ["error-over-parameters", "response", "amplitude", "bands"]
    for figure in figures.values():
        for placed in figure.placed.placed:
            assert re.search(r"\(.+\)$", placed.x_title) and re.search(r"\(.+\)$", placed.y_title)
            lines = [line for line in placed.panel.all_of(Line) if line.x.size]
            assert lines and all(np.isfinite(line.y).any() for line in lines)


@pytest.mark.promise("identify-45")
def test_the_winner_is_marked_among_points_of_each_candidate(found):
    (panel,) = error_over_parameters(found).sheet.panels
    lines = {line.label: line for line in panel.all_of(Line)}
    assert lines["hysteretic stiffness"].x.tolist() == [47, 81]
    assert lines["hysteretic stiffness"].y == pytest.approx([5.23, 5.17])
    assert (lines["chosen"].x.tolist(), lines["chosen"].y) == ([47], pytest.approx([5.23]))
    (band,) = panel.all_of(Span)
    assert (band.low, band.high) == (pytest.approx(5.17), pytest.approx(5.23))
    rules = {rule.label: rule.at for rule in panel.all_of(Rule)}
    assert rules["noise"] == pytest.approx(100 * np.sqrt((0.01**2 + 0.005**2) / 2))
    assert rules["left by the best linear model of each amplitude"] == pytest.approx(0.8, rel=0.1)


def test_noise_far_below_all_models_is_said_and_leaves_them_their_room():
    for noise_rms, drawn in ((NOISE_RMS / 2, True), (NOISE_RMS / 5, False)):
        figure = error_over_parameters(found_of(noise_rms=noise_rms))
        (panel,) = figure.sheet.panels
        assert ("noise" in {rule.label for rule in panel.all_of(Rule)}) is drawn
        assert ("Noise, 0.158 %, lies far below." in figure.caption) is (not drawn)


@pytest.mark.promise("identify-45")
def test_the_response_has_a_panel_for_each_pair_with_measured_and_modelled(found):
    panels = coupled_figures(found)["response"].sheet.panels
    assert [p.title for p in panels] == [
        f"piezo 1 → {HOSTILE}",
        f"piezo 2 → {HOSTILE}",
        "piezo 1 → y1",
        "piezo 2 → y1",
    ]
    measured = found.responses[1]
    for k, panel in enumerate(panels):
        by = {line.label: line for line in panel.all_of(Line)}
        assert by["measured"].y.max() == pytest.approx(1e9 * np.abs(measured.response[:, k // 2, k % 2]).max())
        assert by["modelled"].y.max() == pytest.approx(by["measured"].y.max() / 1.02, rel=0.01)
        assert 0.0 < by["measured less modelled, rms"].y.max() < 0.05 * by["measured"].y.max()
        (interval,) = panel.all_of(Area)
        half = 1.96 / np.sqrt(2.0) * measured.standard_error[:, k // 2, k % 2]
        top = np.abs(measured.response[:, k // 2, k % 2]) + half
        assert interval.label == "95 % confidence"
        assert interval.rings[0][:, 1].max() == pytest.approx(1e9 * top.max(), rel=1e-3)
        assert panel.y.log and panel.x.log


@pytest.mark.promise("identify-45")
def test_bands_hold_all_of_the_error_and_of_the_floor(found, page, data):
    (parts, *_), (noise, *_) = words.band_floors(found)
    response = found.responses[0]
    of_mean = response.residual_power * (response.noise_standard_error / response.standard_error)[:, :, 0] ** 2
    of_a_period = NOISE_RMS[0] ** 2  # not of the mean of two
    assert np.sum(noise**2, axis=0) == pytest.approx(of_a_period, rel=1e-6, abs=0.0)
    assert np.sum(parts**2, axis=0) == pytest.approx(
        (response.residual_power - of_mean).sum(axis=0) + of_a_period, rel=1e-6, abs=0.0
    )
    assert data["linear_floor_band_rms_m"][0] == parts.tolist()
    assert data["noise_band_rms_m"][0] == noise.tolist()
    assert ["Drive, output", "rms of", "3.9 to 40 Hz", "40 to 1230 Hz"] in rows_of(page)
    for what, values in (("error", [31.4, 41.8]), ("best linear", 1e9 * parts[:, 0]), ("noise", 1e9 * noise[:, 0])):
        assert [f"100 mV, {HOSTILE}", what, *(f"{value:.3g}" for value in values)] in rows_of(page)
    panels = bands(found).sheet.panels
    assert [panel.title for panel in panels] == [f"{HOSTILE}, 100 mV", "y1, 100 mV", f"{HOSTILE}, 200 mV", "y1, 200 mV"]
    error, floor, noise = panels[1].all_of(Line)
    assert error.y.tolist() == pytest.approx([62.76, 62.76, 83.68, 83.68])
    assert (noise.y <= 1.5 * floor.y).all()


@pytest.mark.promise("identify-49")
def test_without_responses_what_is_missing_is_said(tmp_path):
    alone = found_of(responses=(None, None), modelled=(None, None), dependence=None, noise_rms=np.full((2, 2), np.nan))
    assert list(coupled_figures(alone)) == ["error-over-parameters", "bands"]
    text = plain(page_of(alone, tmp_path).read_text("utf-8"))
    assert "No amplitude has enough records for a response of its own" in text
    assert "Gain and resonance were not compared over the amplitude" in text
    assert report.coupled_identification_data(alone)["linear_floor_rms_m"] == [[None, None], [None, None]]
    assert not re.search(r"\bnan\b", text + report.coupled_identification_text(alone))


def test_an_amplitude_of_which_nothing_is_held_out_is_left_out(tmp_path):
    rms = np.array([[np.nan, np.nan], [2.0e-6, 4.0e-6]])
    own = candidate("coupled linear, order 3", "coupled linear", 17, 0.2, 0.2 * rms)
    own = replace(own, record_share=np.array([[0.2, 0.2]]))
    found = found_of(candidates=(own,), chosen=own.name, within_noise=(own.name,), output_rms=rms, held_out=("large",))
    assert words.by_amplitude(found) == "It leaves 632 nm rms (20 % of the output) at 200 mV rms drive."
    assert len(bands(found).sheet.panels) == 2
    assert not re.search(r"\bnan\b", plain(page_of(found, tmp_path).read_text("utf-8")))


@pytest.mark.promise("identify-49")
def test_of_many_channels_the_first_are_drawn(found, tmp_path):
    outputs, drives = 6, 5
    wide = np.tile(found.responses[0].response, (1, 3, 3))[:, :outputs, :drives]
    none = np.zeros((3, 0)), np.zeros((0, 3)), np.zeros((0, drives)), np.zeros((outputs, 0))
    mirror = replace(
        plant(), B=np.zeros((3, drives)), C=np.zeros((outputs, 3)), D=np.zeros((outputs, drives)), G=none[2], K=none[3]
    )
    model = replace(
        coupled(),
        mirror=mirror,
        actuators=tuple(Actuator(f"u{k}", 0.0, -1.0, 1.0, 1.0) for k in range(drives)),
        outputs=tuple(Output(f"y{k}", "angle") for k in range(outputs)),
    )
    own = replace(
        found.candidate(),
        model=model,
        error_rms=np.full((2, outputs), 1e-7),
        band_error_rms=np.full((2, 2, outputs), 1e-7),
        record_share=np.full((2, outputs), 0.1),
    )
    response = replace(
        found.responses[0],
        response=wide,
        standard_error=np.abs(wide) / 50,
        noise_standard_error=None,
        residual_power=np.full((wide.shape[0], outputs), 1e-18),
    )
    rms = np.full((2, outputs), 1e-6)
    many = replace(
        found,
        candidates=(own,),
        within_noise=(own.name,),
        output_rms=rms,
        noise_rms=rms / 100,
        responses=(response, None),
        modelled=(0.9 * wide, None),
    )
    figures = coupled_figures(many)
    assert len(figures["response"].sheet.panels) == MOST * MOST == 16
    assert len(figures["bands"].sheet.panels) == 2 * MOST
    assert all("Of 6 outputs and 5 drives the first 4 are drawn." in figures[n].caption for n in ("response", "bands"))
    assert {panel.y.title for panel in figures["response"].sheet.panels} == {"gain (nrad/V)", ""}
    whole = report.coupled_identification_data(many)
    assert (len(whole["outputs"]), len(whole["actuators"])) == (outputs, drives)
    page = page_of(many, tmp_path).read_text("utf-8")
    assert {f"u{k}" for k in range(drives)} <= {row[0] for row in rows_of(page) if row}
    assert all(any(f"y{k}" in cell for row in rows_of(page) for cell in row) for k in range(outputs))
    text = report.coupled_identification_text(many)
    assert len(text.splitlines()) <= MOST_LINES and max(map(len, text.splitlines())) <= 80


def test_what_the_best_linear_model_leaves_counts_from_rest_on(found):
    """A line below 1 Hz belongs to it, too."""
    response = next(each for each in found.responses if each is not None)
    low = replace(response, freq_hz=response.freq_hz * (0.5 / response.freq_hz[0]))
    moved = replace(found, responses=tuple(None if each is None else low for each in found.responses))
    assert low.freq_hz[0] < 1.0
    first = words._floor_powers(moved, np.array([0.0, 1.0]))[0]
    assert np.nanmin(first) > 0.0
    rest = words._floor_powers(moved, np.array([1.0, np.inf]))[0]
    assert np.all(words.linear_floor(moved) > np.sqrt(rest[:, 0]))


def test_poles_beyond_what_was_excited_are_said_to_be_extrapolated(monkeypatch):
    shown = [
        SimpleNamespace(real=True, excited=True, texts=("1 Hz", "2", "3", "4")),
        SimpleNamespace(real=False, excited=False, texts=("5 Hz", "6", "7", "8")),
    ]
    monkeypatch.setattr(coupled_page.words, "poles", lambda own: shown)
    inside, outside = coupled_page._poles(None).rows
    assert [inside[0], *inside[1:5], inside[6]] == ["real pole", "1 Hz", "2", "3", "4", ""]
    assert [outside[0], *outside[1:5], outside[6]] == ["pair", "5 Hz", "6", "7", "8", "extrapolated"]
    assert [inside[5], outside[5]] == [Cell("", "yes"), Cell("", "no")]


@pytest.mark.parametrize("sizes", [(MOST, MOST), (MOST + 1, MOST), (MOST, MOST + 1)])
def test_what_is_not_drawn_is_said_wherever_outputs_or_drives_are_too_many(sizes):
    model = SimpleNamespace(outputs=[None] * sizes[0], actuators=[None] * sizes[1])
    said = coupled_figures_module._left_out(SimpleNamespace(candidate=lambda: SimpleNamespace(model=model)))
    drawn = f" Of {sizes[0]} outputs and {sizes[1]} drives the first {MOST} are drawn."
    assert said == ("" if sizes == (MOST, MOST) else drawn)


def test_gain_and_resonance_are_drawn_over_the_drive_in_the_units_of_their_axes():
    """Drives of 10 and 300 mV, gains of 2 and 3 urad/V, resonances of 100 and 90 Hz, one error not known."""
    drive, gain, error = np.array([0.01, 0.3]), np.array([2e-6, 3e-6]), np.array([0.5, np.nan])
    found = AmplitudeDependence(drive, gain, np.array([100.0, 90.0]), error, np.array([0.1, 0.2]))
    left, right = coupled_figures_module.amplitude(found, "rad").sheet.panels
    assert (left.x.title, left.y.title, right.y.title) == ("drive, rms (mV)", "gain (µrad/V)", "main resonance (Hz)")
    (one,), (other,) = left.marks, right.marks
    assert one.x == pytest.approx([10.0, 300.0]) and one.y == pytest.approx([2.0, 3.0])
    assert other.x == pytest.approx([10.0, 300.0]) and other.y == pytest.approx([100.0, 90.0])
    assert other.y_arms == pytest.approx(np.array([[0.5, 0.0], [0.5, 0.0]]))


def test_every_curve_of_a_response_stands_within_its_axis(found):
    figure = coupled_figures(found)["response"]
    lows = {panel.y.low for panel in figure.sheet.panels}
    curves = [m.y for panel in figure.sheet.panels for m in panel.marks if getattr(m, "label", "").endswith("rms")]
    assert len(lows) == 1 and len(curves) == len(figure.sheet.panels)
    assert lows.pop() == pytest.approx(min(np.nanmin(each) for each in curves) / 1.5, rel=1e-12)


# ----------------------------------------------------------------------------------------------- limits and one or none
def test_a_page_without_warnings_says_so(found):
    assert list(coupled_page._views(replace(found, warnings=()))[0].blocks[0].lines) == ["No warnings."]
    assert list(coupled_page._views(found)[0].blocks[0].lines) == list(found.warnings)


def at_amplitudes(count, known=None):
    """The identification with the first amplitude so many times."""
    own = replace(found_of().candidate(), error_rms=np.repeat(OUTPUT_RMS[:1], count, axis=0))
    if known is not None:
        own.error_rms[known:] = np.nan
    return found_of(
        candidates=(own,),
        within_noise=(own.name,),
        amplitudes_v=0.1 * np.arange(1.0, count + 1),
        output_rms=np.repeat(OUTPUT_RMS[:1], count, axis=0),
        noise_rms=np.repeat(NOISE_RMS[:1], count, axis=0),
        responses=(None,) * count,
        modelled=(None,) * count,
    )


def test_the_amplitudes_are_columns_as_long_as_there_is_room():
    for count, columns in ((5, 5), (6, 0)):
        headings = coupled_page._candidates(at_amplitudes(count)).headings
        assert sum(heading.startswith("at ") for heading in headings) == columns
    assert len(coupled_page._candidates(at_amplitudes(2), short=True).headings) == 4


def test_a_terminal_has_the_first_rows_and_the_last():
    assert [list(coupled_page._few(count)) for count in (3, 4, 5, 9)] == [
        [0, 1, 2],
        [0, 1, 2, 3],
        [0, 1, 2, 4],
        [0, 1, 2, 8],
    ]


@pytest.mark.parametrize(("count", "folded"), [(12, ""), (13, "All 13 held-out records")])
def test_many_records_are_folded(found, count, folded):
    own = replace(found.candidate(), record_share=np.full((count, 2), 0.1))
    many = replace(found, candidates=(own,), held_out=tuple(f"r{k}" for k in range(count)))
    assert coupled_page._records(many).folded == folded


def test_without_a_known_error_there_is_no_table_of_bands():
    unknown = at_amplitudes(2, known=0)
    assert coupled_page._bands(unknown) is None


@pytest.mark.parametrize(
    ("bias_v", "low_v", "high_v", "said"),
    [(5.00049, 4.5, 5.5, 5.0), (5.0006, 4.5, 5.5, 5.001), (-1e-5, -0.5, 0.5, 0.0), (5.00049, 5.0, 5.0, 5.00049)],
)
def test_a_bias_is_told_to_a_thousandth_of_the_range(bias_v, low_v, high_v, said):
    assert str(coupled_page._bias(Actuator("a", bias_v, low_v, high_v, 1.0))) == str(said)


@pytest.mark.parametrize(("lines", "more"), [(60, None), (61, "1 more line is"), (62, "2 more lines are")])
def test_a_mirror_file_is_shown_to_its_sixtieth_line(found, lines, more):
    text = "\n".join(["x" * 160, "y" * 161, *["z"] * (lines - 2)])
    file = coupled_page._origin(found, Path("m.toml"), text).blocks[1]
    shown = file.blocks[0].text.splitlines()
    assert len(shown) == 60
    assert (shown[0], shown[1]) == ("x" * 160, "y" * 150 + " …")
    assert file.blocks[1].startswith(f"{more} in the file") if more else len(file.blocks) == 1


@pytest.mark.parametrize(
    ("values", "unit", "size"),
    [([0.0, np.nan], "m", 1.0), ([np.nan], "m", 1.0), ([2e-6, np.nan], "µm", 1e-6), ([-2e-3], "mm", 1e-3)],
)
def test_a_column_has_the_unit_of_its_largest_value(values, unit, size):
    found = words.scale(values, "m")
    assert (found.unit, found.size) == (unit, pytest.approx(size))
    assert (found.text(np.nan), found.text(-1.2346 * size)) == ("", "\u22121.23")


def test_a_pole_at_the_edge_of_the_band_was_excited():
    for low_hz, high_hz, excited in ((2.0, 9.0, True), (1.0, 2.0, True), (2.1, 9.0, False), (1.0, 1.9, False)):
        assert words._pole(complex(-4.0 * np.pi, 0.0), 0.1 + 0.0j, low_hz, high_hz).excited is excited


@pytest.mark.parametrize(("share", "sound"), [(0.4999, True), (0.5, False), (0.6, False)])
def test_a_model_that_leaves_half_of_the_output_is_of_no_use(found, share, sound):
    own = replace(found.candidate(), error_share=share)
    assert words.sound(replace(found, candidates=(own,))) is sound
    assert words.sound(replace(found, candidates=(own,), stopped=True)) is None


def test_the_error_is_told_at_up_to_four_amplitudes_then_at_three():
    said = [words.by_amplitude(at_amplitudes(count)) for count in (1, 4, 5)]
    assert [text.count(" rms drive") for text in said] == [1, 4, 3]
    assert said[2].startswith("It leaves 1.58 µm rms (100 % of the output) at 100 mV rms drive, ")
    assert " at 300 mV rms drive and " in said[2] and said[2].endswith(" at 500 mV rms drive.")
    assert words.by_amplitude(at_amplitudes(2, known=0)) == ""
    assert words.by_amplitude(at_amplitudes(2, known=1)).count(" rms drive") == 1


@pytest.mark.parametrize(
    ("held", "fitted", "said"),
    [
        (1, 1, "This rests on r0; 1 other record was fitted."),
        (2, 2, "This rests on r0 and r1; 2 other records were fitted."),
        (4, 2, "This rests on r0, r1, r2 and r3; 2 other records were fitted."),
        (5, 2, "This rests on r0, r1, r2, r3 and 1 more; 2 other records were fitted."),
    ],
)
def test_the_verdict_rests_on_four_named_records_and_a_number_of_others(found, held, fitted, said):
    names = tuple(f"r{k}" for k in range(5))
    assert words.rests_on(replace(found, held_out=names[:held], fitted=names[:fitted])) == said


@pytest.mark.parametrize(
    ("error_s", "said"), [(5e-6, "200 µs ± 5 µs late"), (0.0, "200 µs late"), (np.nan, "200 µs late")]
)
def test_a_delay_has_its_error_where_that_is_known(found, error_s, said):
    assert words.delay_text(replace(found.candidate(), delay_error_s=error_s)).startswith(f"The drive acts {said}.")


@pytest.mark.parametrize(
    ("outputs", "ways"),
    [
        ([("displacement", True)] * 4, False),
        ([("displacement", True)] * 3, True),
        ([("displacement", False)] * 4, True),
        ([("angle", False)] * 4, True),
        ([("displacement", True)] * 3 + [("angle", False)], True),
    ],
)
def test_which_way_round_the_channels_are_is_open_without_four_sensors_of_known_places(found, outputs, ways):
    channels = tuple(Output(f"y{k}", what, (0.01, 0.0) if placed else None) for k, (what, placed) in enumerate(outputs))
    model = SimpleNamespace(outputs=channels, excited_hz=(1.0, 2.0), known=object())
    said = words.not_held(replace(found, candidates=(replace(found.candidate(), model=model),)))
    assert any(text.startswith("Which way round") for text in said) is ways
    placeless = any(what == "displacement" and not placed for what, placed in outputs)
    assert any(text.startswith("A geometry") for text in said) is placeless


def test_noise_at_the_least_share_is_said_and_not_drawn(monkeypatch):
    found = found_of()
    least = min(each.error_share for each in found.candidates)
    for noise, drawn in (
        (least / coupled_figures_module._FAR, False),
        (1.01 * least / coupled_figures_module._FAR, True),
    ):
        monkeypatch.setattr(coupled_figures_module, "_share", lambda rms, found, noise=noise: noise)
        figure = error_over_parameters(found)
        assert any(rule.label == "noise" for rule in figure.sheet.panels[0].all_of(Rule)) is drawn
        assert ("lies far below" in figure.caption) is not drawn


def test_bands_of_many_amplitudes_are_those_of_the_first_the_middle_and_the_last():
    for count, drives in ((MOST, ["100 mV", "200 mV", "300 mV", "400 mV"]), (MOST + 1, ["100 mV", "300 mV", "500 mV"])):
        found = at_amplitudes(count)
        own = replace(found.candidate(), band_error_rms=np.ones((count, 2, 2)))
        titles = [panel.title for panel in bands(replace(found, candidates=(own,))).sheet.panels]
        assert [title.rpartition(", ")[2] for title in titles[::2]] == drives


# --------------------------------------------------------------------------------- two channels unlike, as a whole
def unlike_candidate(name, kind, parameters, share, note=""):
    """A model whose errors differ by amplitude, band and output."""
    error = share * OUTPUT_RMS * np.array([[1.0, 1.25], [1.5, 0.75]])
    bands = np.stack([0.6 * error, 0.8 * error], axis=1) * np.array([1.0, 1.125])
    made = candidate(name, kind, parameters, share, error, **({"note": note} if note else {}))
    return replace(made, band_error_rms=bands, record_share=share * np.array([[0.5, 1.5], [2.0, 1.25]]))


def unlike_found(**changes):
    return found_of(
        candidates=(
            unlike_candidate("per axis, order 2", "per axis", 11, 0.523),
            unlike_candidate("coupled linear, order 3", "coupled linear", 17, 0.2171, "its search had not settled"),
            unlike_candidate("hysteretic stiffness, order 3", "hysteretic stiffness", 47, 0.0523),
            unlike_candidate("hysteretic stiffness, order 5", "hysteretic stiffness", 81, 0.0517),
        ),
        **changes,
    )


def test_the_amplitudes_and_records_of_unlike_errors_have_each_its_own_number():
    found = unlike_found()
    rows = [[str(cell) for cell in row] for row in coupled_page._amplitudes(found).rows]
    assert [row[:4] + row[6:] for row in rows] == [
        ["100 mV", "1580", "99.6", "5.92 %", "y1, 6.54 %"],
        ["200 mV", "3160", "157", "6.2 %", "<b>sensor</b>, 7.84 %"],
    ]
    shown = [coupled_page._records(found), coupled_page._candidates(found), coupled_page._poles(found.candidate())]
    assert [[[str(cell) for cell in row] for row in each.rows] for each in shown] == [
        [["small <3>.npy", "5.85 %", "2.61 %", "7.84 %"], ["large <3>.npy", "8.72 %", "10.5 %", "6.54 %"]],
        [
            ["hysteretic stiffness, order 5", "81", "5.17 %", "5.85 %", "6.13 %", "within noise"],
            ["hysteretic stiffness, order 3", "47", "5.23 %", "5.92 %", "6.2 %", "chosen"],
            ["coupled linear, order 3", "17", "22 %", "25 %", "26 %", ""],
            ["per axis, order 2", "11", "52.3 %", "59.2 %", "62 %", ""],
        ],
        [["pair", "79.64", "0.32", "0.04", "0.002", "yes", ""], ["real pole", "143.2", "4.8", "1", "", "yes", ""]],
    ]
    assert views_text([coupled_page._dependence(found, {})], 100).split("\n") == [
        "Dependence on the amplitude",
        "",
        ("From the smallest to the largest amplitude the gain changes by +5.2 % and the main resonance by"),
        "−1.38 Hz.",
        "",
        " drive, rms   gain (µm/V)   main resonance (Hz)   ± (Hz)   damping ratio",
        " ───────────────────────────────────────────────────────────────────────",
        " 100 mV       2             79.58                 0.2      0.04",
        " 200 mV       2.104         78.2                  0.1      0.04",
    ]
    assert [[str(cell) for cell in row] for row in coupled_page._range(found.candidate()).rows] == [
        ["piezo 1", "5 V", "4.25 V", "5.75 V", "15 kV/s"],
        ["piezo 2", "4 V", "3.5 V", "4.5 V", "10 kV/s"],
    ]


def test_the_bands_of_unlike_errors_have_a_row_for_each_amplitude_and_output():
    rows = [row for row in coupled_page._bands(unlike_found()).rows if row[1] == "error"]
    assert [list(row) for row in rows] == [
        ["100 mV, <b>sensor</b>", "error", "31.4", "41.8"],
        ["100 mV, y1", "error", "88.3", "118"],
        ["200 mV, <b>sensor</b>", "error", "94.1", "126"],
        ["200 mV, y1", "error", "106", "141"],
    ]


def test_all_that_is_said_of_unlike_errors():
    found = unlike_found()
    said = [*words.verdict(found), words.delay_text(found.candidate()), *words.not_held(found)]
    assert said == [
        (
            "Hysteretic stiffness, order 3 (47 parameters) predicts 2 records that no fit has "
            "seen with an error of 5.23 % of the rms output."
        ),
        (
            "It leaves 99.6 nm rms (5.92 % of the output) at 100 mV rms drive and 157 nm rms "
            "(6.2 % of the output) at 200 mV rms drive."
        ),
        "The worst is <b>sensor</b> of large <3>.npy: 10.5 %.",
        "This rests on small <3>.npy and large <3>.npy; 6 other records were fitted.",
        "The smaller of two whose difference may be chance.",
        (
            "The drive acts 200 µs ± 5 µs late. That delay belongs to the recording chain "
            "(converters, filters, amplifier), not to the mirror: the mirror file holds it "
            "apart."
        ),
        ("Creep: nothing below 3.9 Hz was excited, so what the mirror does within minutes of a step was not seen."),
        "Modes above 400 Hz: nothing was excited there.",
        (
            "A geometry: where the displacements are measured was not stated, so tilts and "
            "piston cannot be had from them."
        ),
        (
            "Which way round the channels are: a reversed sensor and two swapped channels are "
            "another mirror, and show only against signs that are stated, or against the "
            "places of four sensors or more."
        ),
        "Uncertainty: standard errors of the parameters are not known.",
    ]


def test_the_figures_of_unlike_errors_have_a_point_for_each_model_and_a_curve_for_each_band():
    found = unlike_found()
    figure = coupled_figures_module.error_over_parameters(found)
    kept = [line for line in lines_of(figure.sheet) if not line.startswith("Rule")]
    assert [line for line in kept if line.startswith(("Line", "Span", "Panel"))] == [
        ("Panel 0 0 x=<title=parameters (1) log=True> y=<title=error on held-out records (% of rms output)"),
        ("Span low=5.17 high=5.23 upright=False colour=#009E73 opacity=0.25 label=within noise of the best"),
        "Line x=[11] y=[52.3] colour=#56B4E9 dash=: width=0.7 label=per axis marker=s size=7",
        "Line x=[17] y=[21.71] colour=#0072B2 dash=: width=0.7 label=coupled linear marker=o size=7",
        ("Line x=[47 81] y=[5.23 5.17] colour=#D55E00 dash=: width=0.7 label=hysteretic stiffness marker=^"),
        "Line x=[47] y=[5.23] dash= label=chosen marker=o size=11 face= edge=#000000",
    ]
    drawn = [
        [[*line.y] for line in panel.all_of(Line) if line.label == "measured less modelled"]
        for panel in coupled_figures_module.bands(found).sheet.panels
    ]
    expected = [(0.6, 0.8), (1.6875, 2.25), (1.8, 2.4), (2.025, 2.7)]
    for (curve,), (low, high) in zip(drawn, expected, strict=True):
        assert curve == pytest.approx(52.3 * np.array([low, low, high, high]), rel=1e-6)
    assert lines_of(coupled_figures_module.amplitude(found.dependence, "m").sheet) == [
        "Sheet width=8.2 height=2.8 widths=[1 1]",
        "Panel 0 0 x=<title=drive, rms (mV) most=6> y=<title=gain (µm/V) most=6>",
        "Line x=[100 200] y=[2 2.104] colour=#0072B2 dash=: width=0.8 marker=o",
        "Panel 0 1 x=<title=drive, rms (mV) most=6> y=<title=main resonance (Hz) most=6>",
        ("Line x=[100 200] y=[79.58 78.2] colour=#0072B2 dash=: width=0.8 marker=o y_arms=[[0.2 0.1] [0.2"),
        "  0.1]]",
    ]


# --------------------------------------------------------------------------------------------------- pages as a whole
def test_a_page_of_several_channels_has_every_part_with_its_tables_in_their_order():
    found = found_of()
    assert outline(
        coupled_page._lead(found, "one more"), *coupled_page._views(found, coupled_figures(found))
    ) == one_text("""
= True: Hysteretic stiffness, order 3 (47 parameters) predicts 2 records that no fit has seen with an error of 5.23
  % of the rms output.
It leaves 82.7 nm rms (5.23 % of the output) at 100 mV rms drive and 165 nm rms (5.23 % of the output) at 200 mV rms
  drive. The worst is y1 of small <3>.npy: 5.75 %. This rests on small <3>.npy and large <3>.npy; 6 other records
  were fitted. The smaller of two whose difference may be chance.
one more
# Warnings
- Output y1 drifts.
- Few realisations.
# Which model
[error-over-parameters]
| -: model / parameters / held-out error / at 100 mV rms / at 200 mV rms /  [0, 5] best [1] cards
hysteretic stiffness, order 5 / 81 / 5.17 % / 5.17 % / 5.17 % / within noise
hysteretic stiffness, order 3 / 47 / 5.23 % / 5.23 % / 5.23 % / chosen
coupled linear, order 3 / 17 / 22 % / 22 % / 22 % /
per axis, order 2 / 11 / 52.3 % / 52.3 % / 52.3 % /
- coupled linear, order 3: its search had not settled
Models that were refused, with the reason:
- hysteretic stiffness, order 9: the fitted mirror <runs> away
# Error on held-out records
| -: drive, rms / output (nm) / error (nm) / of output / best linear (nm) / noise (nm) / worst output [0, 6] brief
  [0, 2, 3, 4, 6] cards
100 mV / 1580 / 82.7 / 5.23 % / 15.9 / 15.8 / <b>sensor</b>, 5.23 %
200 mV / 3160 / 165 / 5.23 % / 15.9 / 15.8 / <b>sensor</b>, 5.23 %
Per cent are of the rms output, the mean over outputs in power. The best linear model is the measured response of
  that amplitude: what it leaves of the fitted records is distortion and noise, and no linear model leaves less.
  Noise is what changes from period to period.
| -: held-out record / error / <b>sensor</b> / y1 [0] cards
small <3>.npy / 5.26 % / 4.71 % / 5.75 %
large <3>.npy / 5.23 % / 5.23 % / 5.23 %
# Response
[response]
# Dependence on the amplitude
From the smallest to the largest amplitude the gain changes by +5.2 % and the main resonance by −1.38 Hz.
[amplitude]
| -: drive, rms / gain (µm/V) / main resonance (Hz) / ± (Hz) / damping ratio [0]
100 mV / 2 / 79.58 / 0.2 / 0.04
200 mV / 2.104 / 78.2 / 0.1 / 0.04
# Poles
| -: pole at rest / frequency (Hz) / ± (Hz) / damping ratio (1) / ± (1) / excited /  [0, 5, 6]
pair / 79.64 / 0.32 / 0.04 / 0.002 / yes /
real pole / 143.2 / 4.8 / 1 /  / yes /
± is one standard error; it says nothing of what the model leaves out.
# Error by output and band
[bands]
| The same as numbers: rms in each band (nm): drive, output / rms of / 3.9 to 40 Hz / 40 to 1230 Hz [0, 1]
100 mV, <b>sensor</b> / error / 31.4 / 41.8
100 mV, <b>sensor</b> / best linear / 3.49 / 9.92
100 mV, <b>sensor</b> / noise / 3.14 / 9.49
100 mV, y1 / error / 62.8 / 83.7
100 mV, y1 / best linear / 6.13 / 19
100 mV, y1 / noise / 6.24 / 19
200 mV, <b>sensor</b> / error / 62.8 / 83.7
200 mV, <b>sensor</b> / best linear / 3.49 / 9.92
200 mV, <b>sensor</b> / noise / 3.13 / 9.5
200 mV, y1 / error / 126 / 167
200 mV, y1 / best linear / 6.14 / 19
200 mV, y1 / noise / 6.25 / 19
# Where it holds
| -: actuator / bias / lowest drive / highest drive / fastest rate [0]
piezo 1 / 5 V / 4.25 V / 5.75 V / 15 kV/s
piezo 2 / 4 V / 3.5 V / 4.5 V / 10 kV/s
The drive acts 200 µs ± 5 µs late. That delay belongs to the recording chain (converters, filters, amplifier), not
  to the mirror: the mirror file holds it apart.
# What the mirror file does not hold
- Creep: nothing below 3.9 Hz was excited, so what the mirror does within minutes of a step was not seen.
- Modes above 400 Hz: nothing was excited there.
- A geometry: where the displacements are measured was not stated, so tilts and piston cannot be had from them.
- Which way round the channels are: a reversed sensor and two swapped channels are another mirror, and show only
  against signs that are stated, or against the places of four sensors or more.
- Uncertainty: standard errors of the parameters are not known.
""")


def test_a_stopped_ladder_without_responses_says_so_in_each_part():
    found = found_of(
        responses=(None, None),
        modelled=(None, None),
        dependence=None,
        stopped=True,
        warnings=(),
        refused=(),
        noise_rms=np.full((2, 2), np.nan),
        reason="",
    )
    views = coupled_page._views(found)
    assert outline(coupled_page._lead(found), *views[:5], views[6]) == one_text("""
= None: Stopped before the last model, so the choice so far: hysteretic stiffness, order 3 (47 parameters) predicts
  2 records that no fit has seen with an error of 5.23 % of the rms output.
It leaves 82.7 nm rms (5.23 % of the output) at 100 mV rms drive and 165 nm rms (5.23 % of the output) at 200 mV rms
  drive. The worst is y1 of small <3>.npy: 5.75 %. This rests on small <3>.npy and large <3>.npy; 6 other records
  were fitted.
# Warnings
- No warnings.
# Which model
The ladder was stopped before its last model: what is chosen is the smallest within noise so far.
| -: model / parameters / held-out error / at 100 mV rms / at 200 mV rms /  [0, 5] best [1] cards
hysteretic stiffness, order 5 / 81 / 5.17 % / 5.17 % / 5.17 % / within noise
hysteretic stiffness, order 3 / 47 / 5.23 % / 5.23 % / 5.23 % / chosen
coupled linear, order 3 / 17 / 22 % / 22 % / 22 % /
per axis, order 2 / 11 / 52.3 % / 52.3 % / 52.3 % /
- coupled linear, order 3: its search had not settled
No model was refused.
# Error on held-out records
| -: drive, rms / output (nm) / error (nm) / of output / best linear (nm) / noise (nm) / worst output [0, 6] brief
  [0, 2, 3, 4, 6] cards
100 mV / 1580 / 82.7 / 5.23 % /  /  / <b>sensor</b>, 5.23 %
200 mV / 3160 / 165 / 5.23 % /  /  / <b>sensor</b>, 5.23 %
Per cent are of the rms output, the mean over outputs in power. The best linear model is the measured response of
  that amplitude: what it leaves of the fitted records is distortion and noise, and no linear model leaves less.
  Noise is what changes from period to period.
| -: held-out record / error / <b>sensor</b> / y1 [0] cards
small <3>.npy / 5.26 % / 4.71 % / 5.75 %
large <3>.npy / 5.23 % / 5.23 % / 5.23 %
# Response
No amplitude has enough records for a response of its own: as many realisations with different drives as there are
  actuators, or broadband drives of one actuator at a time.
# Dependence on the amplitude
The ladder was stopped before gain and resonance were compared over the amplitude.
# Error by output and band
| The same as numbers: rms in each band (nm): drive, output / rms of / 3.9 to 40 Hz / 40 to 1230 Hz [0, 1]
100 mV, <b>sensor</b> / error / 31.4 / 41.8
100 mV, y1 / error / 62.8 / 83.7
200 mV, <b>sensor</b> / error / 62.8 / 83.7
200 mV, y1 / error / 126 / 167
""")


def test_a_gain_that_falls_and_a_resonance_without_an_error_are_told_with_a_minus():
    of = AmplitudeDependence(
        np.array([0.25, 0.5, 2.0]),
        np.array([4.0e-6, 3.5e-6, 3.0e-6]),
        np.array([80.0, 82.5, 91.25]),
        np.array([0.5, np.nan, 0.25]),
        np.array([0.01, 0.025, 0.5]),
    )
    assert outline(coupled_page._dependence(found_of(dependence=of), {})) == one_text("""
# Dependence on the amplitude
From the smallest to the largest amplitude the gain changes by −25 % and the main resonance by +11.2 Hz.
| -: drive, rms / gain (µm/V) / main resonance (Hz) / ± (Hz) / damping ratio [0]
250 mV / 4 / 80 / 0.5 / 0.01
500 mV / 3.5 / 82.5 / not known / 0.025
2 V / 3 / 91.25 / 0.25 / 0.5
""")


def test_thirteen_records_are_folded_and_the_first_five_outputs_are_columns():
    base = candidate("one", "per axis", 11, 0.1)
    share = 0.01 * np.arange(1.0, 79.0).reshape(13, 6)
    outputs = tuple(Output(f"y{k}", "angle") for k in range(6))
    own = replace(base, record_share=share, model=SimpleNamespace(outputs=outputs))
    found = found_of(candidates=(own,), chosen="one", held_out=tuple(f"r{k}.npy" for k in range(13)))
    assert outline(coupled_page._records(found)) == one_text("""
| All 13 held-out records: held-out record / error / y0 / y1 / y2 / y3 / y4 [0] cards
r0.npy / 3.89 % / 1 % / 2 % / 3 % / 4 % / 5 %
r1.npy / 9.65 % / 7 % / 8 % / 9 % / 10 % / 11 %
r2.npy / 15.6 % / 13 % / 14 % / 15 % / 16 % / 17 %
r3.npy / 21.6 % / 19 % / 20 % / 21 % / 22 % / 23 %
r4.npy / 27.6 % / 25 % / 26 % / 27 % / 28 % / 29 %
r5.npy / 33.5 % / 31 % / 32 % / 33 % / 34 % / 35 %
r6.npy / 39.5 % / 37 % / 38 % / 39 % / 40 % / 41 %
r7.npy / 45.5 % / 43 % / 44 % / 45 % / 46 % / 47 %
r8.npy / 51.5 % / 49 % / 50 % / 51 % / 52 % / 53 %
r9.npy / 57.5 % / 55 % / 56 % / 57 % / 58 % / 59 %
r10.npy / 63.5 % / 61 % / 62 % / 63 % / 64 % / 65 %
r11.npy / 69.5 % / 67 % / 68 % / 69 % / 70 % / 71 %
r12.npy / 75.5 % / 73 % / 74 % / 75 % / 76 % / 77 %
""")
    few = replace(found, held_out=found.held_out[:12], candidates=(replace(own, record_share=share[:12, :5]),))
    assert outline(coupled_page._records(few)).split("\n")[0] == one_text("""
| -: held-out record / error / y0 / y1 / y2 / y3 / y4 [0] cards
""")


def test_the_head_of_a_page_of_several_channels_counts_them_and_says_where_records_come_from(monkeypatch):
    seen = []
    monkeypatch.setattr(coupled_page, "page_of", lambda *args, **more: seen.append((args, more)) or "page")
    given = {"mirror_file": Path("a<b>.toml"), "mirror_text": "text", "title": "A title"}
    for virtual in (True, False):
        coupled_page.coupled_identification_page(found_of(), **given, virtual=virtual)
    heads = [[*args[:2], str(args[2]), args[3][0].blocks[1:], len(args[4]), *more.values()] for args, more in seen]
    digest = "982d9e3eb996f559e633f4d194def3761d909f5a3b647d1a851fead67c32c9d1"
    said = "The recordings are those of the virtual bench: nothing here was measured on a mirror."
    head = ["A title", "identification", "2 actuators and 2 outputs, mirror file <code>a&lt;b&gt;.toml</code>"]
    assert heads == [
        [*head, (said,), 10, digest, "microrad identify", "virtual bench"],
        [*head, (), 10, digest, "microrad identify", ""],
    ]


def test_a_terminal_has_both_files_at_its_end_and_only_those_that_there_are():
    for files, last in (
        ({}, "1 refused model: see the report, or --json."),
        ({"mirror_file": Path("a.toml")}, "a.toml written (hysteretic stiffness, order 3)."),
        ({"report_file": Path("b.html")}, "b.html written: what was found, with pictures."),
    ):
        text = report.coupled_identification_text(found_of(), 100, **files)
        assert text.endswith(last)
    both = report.coupled_identification_text(found_of(), 100, mirror_file=Path("a.toml"), report_file=Path("b.html"))
    assert both.split("\n")[-2:] == [
        "b.html written: what was found, with pictures.",
        "a.toml written (hysteretic stiffness, order 3).",
    ]


def test_a_gain_that_more_than_doubles_has_no_power_of_ten():
    of = AmplitudeDependence(
        np.array([0.25, 2.0]), np.array([2e-6, 5e-6]), np.array([80.0, 1314.0]), np.array([0.5, 0.25]), np.full(2, 0.1)
    )
    said, *_ = coupled_page._dependence(found_of(dependence=of), {}).blocks
    assert said.endswith("the gain changes by +150 % and the main resonance by +1.23 kHz.")


def test_a_figure_of_some_amplitudes_says_which_are_drawn():
    for count, some in ((MOST, False), (MOST + 1, True)):
        found = at_amplitudes(count)
        own = replace(found.candidate(), band_error_rms=np.ones((count, 2, 2)))
        caption = bands(replace(found, candidates=(own,))).caption
        assert (f" Of {count} rms drives the first, the middle and the last are drawn." in caption) is some


def test_one_drive_of_many_outputs_is_told_in_the_singular():
    model = SimpleNamespace(outputs=[None] * (MOST + 2), actuators=[None])
    said = coupled_figures_module._left_out(SimpleNamespace(candidate=lambda: SimpleNamespace(model=model)))
    assert said == f" Of {MOST + 2} outputs and 1 drive the first {MOST} are drawn."


@pytest.mark.parametrize("virtual", [False, True])
def test_a_page_of_several_channels_has_all_that_is_given_and_spares_a_file_that_appears(
    monkeypatch, tmp_path, virtual
):
    target, seen = tmp_path / "r.html", []

    def page(found, **given):
        seen.append((found, given))
        if virtual:
            target.write_text(BEGINS + "first", encoding="utf-8")
        return BEGINS + "new"

    monkeypatch.setattr(coupled_page, "coupled_identification_page", page)
    given = {"mirror_file": Path("m.toml"), "mirror_text": "text", "title": "A title", "virtual": virtual}
    if virtual:
        with pytest.raises(report.ReportError, match=r"r\.html exists and is left as it is"):
            coupled_page.write_coupled_identification("found", target, **given)
    else:
        assert coupled_page.write_coupled_identification("found", target, **given) == target
    assert seen == [("found", given)]
    assert target.read_text("utf-8") == BEGINS + ("first" if virtual else "new")


def by_hand_of_floors():
    """Three amplitudes: without noise of its own, without a response, and with both; all numbers unlike."""

    def response(power, share):
        power = np.array(power)
        error = np.stack([np.array([[2.0, 5.0]] * 3), np.array([[7.0, 11.0]] * 3)], axis=2)
        noise = None if share is None else error * np.array([share, [0.1, 0.9]]).T
        return SimpleNamespace(
            freq_hz=np.array([1.0, 2.0, 3.0]),
            residual_power=power,
            standard_error=error,
            noise_standard_error=noise,
        )

    return SimpleNamespace(
        amplitudes_v=np.array([0.1, 0.2, 0.4]),
        bands_hz=np.array([1.0, 2.0, 3.0]),
        output_rms=np.ones((3, 2)),
        noise_rms=np.sqrt([[100.0, 200.0], [300.0, 400.0], [7.0, 4.5]]),
        responses=[
            response([[16.0, 1.0], [9.0, 4.0], [16.0, 5.0]], None),
            None,
            response([[4.0, 9.0], [2.0, 0.0], [1.0, 0.0]], [0.5, 1.0]),
        ],
    )


def test_floors_by_hand_are_raised_to_the_noise_of_their_own_amplitude_and_output():
    """Of the third amplitude a quarter of the first output's power is noise of the mean, 1.75 in all, four times less
    than the noise of the held-out records; the second output's is all noise, and more than that of the records.
    """
    found = by_hand_of_floors()
    floor, noise = words.band_floors(found)
    nothing = [np.nan, np.nan]
    np.testing.assert_allclose(
        floor**2,
        [[[16.0, 1.0], [25.0, 9.0]], [nothing, nothing], [[4.0 + 3.0, 9.0], [3.0 + 3.0 * 0.75, np.nan]]],
    )
    np.testing.assert_allclose(noise**2, [[nothing, nothing], [nothing, nothing], [[4.0, 9.0], [4.0 * 0.75, np.nan]]])
    np.testing.assert_allclose(words.linear_floor(found) ** 2, [[41.0, 10.0], nothing, [12.25, 9.0]])


@pytest.mark.parametrize("short", [False, True])
def test_output_error_floor_and_noise_of_each_amplitude_stand_in_a_row_of_their_own(monkeypatch, short):
    count = 6
    size = np.arange(1.0, count + 1)[:, None]
    outputs = [SimpleNamespace(name="tip", quantity="angle"), SimpleNamespace(name="tilt", quantity="angle")]
    own = SimpleNamespace(
        error_rms=1e-6 * size * np.array([[3.0, 4.0]]), model=SimpleNamespace(outputs=outputs), note=""
    )
    own.error_rms[4] = np.nan
    found = SimpleNamespace(
        candidate=lambda: own,
        amplitudes_v=0.1 * size[:, 0],
        output_rms=1e-6 * (10.0 + size) * np.array([[7.0, 1.0]]),
        noise_rms=1e-8 * size**2 * np.array([[7.0, 1.0]]),
    )
    monkeypatch.setattr(words, "linear_floor", lambda found: 1e-6 * size**0.5 * np.array([[7.0, 1.0]]))
    table = coupled_page._amplitudes(found, short=short)
    assert [*table.headings] == [
        *("drive, rms", "output (µrad)", "error (µrad)", "of output", "best linear (µrad)", "noise (µrad)"),
        "worst output",
    ]
    rows = []
    for k in (0, 1, 2, 5) if short else range(count):
        n = k + 1
        drive, output = f"{100 * n} mV", f"{5.0 * (10 + n):.3g}"
        shares = np.array([3.0, 4.0]) * n / ((10 + n) * np.array([7.0, 1.0]))
        error = "" if k == 4 else f"{12.5**0.5 * n:.3g}"
        share = "" if k == 4 else f"{100 * np.sqrt(np.mean(shares**2)):.3g} %"
        worst = "" if k == 4 else f"tilt, {100 * shares[1]:.3g} %"
        rows.append((drive, output, error, share, f"{5 * n**0.5:.3g}", f"{0.05 * n**2:.3g}", worst))
    assert [tuple(map(str, row)) for row in table.rows] == rows


def test_the_responses_of_three_outputs_and_two_drives_stand_output_by_output():
    of = np.array([[2.0, 3.0], [5.0, 7.0], [11.0, 13.0]]) * 1e-6
    freq = np.array([1.0, 10.0, 100.0])
    measured = SimpleNamespace(
        freq_hz=freq,
        response=np.array([4.0, 2.0j, -1.0])[:, None, None] * of,
        standard_error=0.01 * np.ones((3, 1, 1)) * of,
        method="a method",
    )
    outputs = [SimpleNamespace(name=name, quantity="displacement") for name in ("tip", "tilt", "piston")]
    model = SimpleNamespace(outputs=outputs, actuators=[SimpleNamespace(name="left"), SimpleNamespace(name="right")])
    found = SimpleNamespace(
        candidate=lambda: SimpleNamespace(model=model),
        chosen="coupled linear, order 3",
        amplitudes_v=np.array([0.1, 0.25]),
        responses=[None, measured],
        modelled=[None, measured.response * np.array([1.0, 1.5, 0.5])[:, None, None]],
    )
    figure = coupled_figures_module.response(found, 1)
    assert figure.title == "Frequency response at 250 mV rms drive"
    assert "at 250 mV rms drive (a method). The model is coupled linear, order 3, the chosen one, " in figure.caption
    assert (figure.sheet.heights, figure.sheet.widths) == ((1.0,) * 3, (1.0,) * 2)
    panels = figure.sheet.panels
    assert [(panel.row, panel.column, panel.title, panel.x.title, panel.y.title) for panel in panels] == [
        (0, 0, "left → tip", "", "gain (µm/V)"),
        (0, 1, "right → tip", "", ""),
        (1, 0, "left → tilt", "", "gain (µm/V)"),
        (1, 1, "right → tilt", "", ""),
        (2, 0, "left → piston", "frequency (Hz)", "gain (µm/V)"),
        (2, 1, "right → piston", "frequency (Hz)", ""),
    ]
    for panel, scale in zip(panels, 1e6 * of.ravel(), strict=True):
        seen, left, modelled = panel.all_of(Line)
        np.testing.assert_allclose(seen.y, scale * np.array([4.0, 2.0, 1.0]))
        np.testing.assert_allclose(modelled.y, scale * np.array([4.0, 3.0, 0.5]))
        assert np.isnan(left.y[0]) and left.y[1:] == pytest.approx([scale, 0.5 * scale])
        (ring,) = panel.all_of(Area)[0].rings
        half = 0.01 * scale * 1.96 / np.sqrt(2.0)
        np.testing.assert_allclose(ring[:3, 1], scale * np.array([4.0, 2.0, 1.0]) - half)
        assert panel.y.low == pytest.approx(1.0 / 1.5)  # under the least that the model leaves anywhere: 2 · 0.5


def test_a_short_table_has_the_best_model_of_each_kind_and_the_chosen_one():
    more = (
        unlike_candidate("coupled linear, order 5", "coupled linear", 31, 0.1937),
        unlike_candidate("per axis, order 4", "per axis", 19, 0.6125),
    )
    found = unlike_found()
    table = coupled_page._candidates(replace(found, candidates=(*more, *found.candidates)), short=True)
    assert [tuple(map(str, row)) for row in table.rows] == [
        ("hysteretic stiffness, order 5", "81", "5.17 %", "within noise"),
        ("hysteretic stiffness, order 3", "47", "5.23 %", "chosen"),
        ("coupled linear, order 5", "31", "19.4 %", ""),
        ("per axis, order 2", "11", "52.3 %", ""),
    ]
    assert [*table.best] == [1]


@pytest.mark.parametrize("without", [0, 2, 3])
def test_one_sensor_of_four_without_a_place_leaves_geometry_and_signs_open(found, without):
    outputs = tuple(Output(f"y{k}", "displacement", None if k == without else (0.01, k / 100)) for k in range(4))
    model = SimpleNamespace(outputs=outputs, excited_hz=(1.0, 2.0), known=object())
    said = words.not_held(replace(found, candidates=(replace(found.candidate(), model=model),)))
    for begins in ("A geometry: where the displacements are measured was not stated", "Which way round the channels"):
        assert sum(text.startswith(begins) for text in said) == 1


def test_an_amplitude_of_which_nothing_is_held_out_between_two_others_leaves_each_its_own_numbers():
    rms = 1e-6 * np.array([[1.0, 2.0], [np.nan, np.nan], [4.0, 8.0]])
    error = rms * np.array([[0.1], [np.nan], [0.2]])
    own = replace(found_of().candidate(), error_rms=error, band_error_rms=error[:, None, :] * [[[0.6], [0.8]]])
    none = {"noise_rms": 0.01 * rms, "responses": (None,) * 3, "modelled": (None,) * 3}
    drives = {"amplitudes_v": np.array([0.1, 0.2, 0.3]), "output_rms": rms}
    found = found_of(candidates=(own,), within_noise=(own.name,), **drives, **none)
    table = coupled_page._candidates(found)
    assert [*table.headings[3:5]] == ["at 100 mV rms", "at 300 mV rms"]
    assert [row[3:5] for row in table.rows] == [("10 %", "20 %")]
    assert words.by_amplitude(found) == (
        "It leaves 158 nm rms (10 % of the output) at 100 mV rms drive and 1.26 µm rms (20 % of the output) at 300 mV "
        "rms drive."
    )
    assert [row[3] for row in coupled_page._amplitudes(found).rows] == ["10 %", "", "20 %"]
    names = [output.name for output in own.model.outputs]
    assert [(row[0], *row[2:]) for row in coupled_page._bands(found).rows] == [
        (f"100 mV, {names[0]}", "0.06", "0.08"),
        (f"100 mV, {names[1]}", "0.12", "0.16"),
        (f"300 mV, {names[0]}", "0.48", "0.64"),
        (f"300 mV, {names[1]}", "0.96", "1.28"),
    ]
    panels = bands(found).sheet.panels
    assert [(panel.row, panel.column, panel.title) for panel in panels] == [
        (row, column, f"{name}, {drive}")
        for row, drive in enumerate(("100 mV", "300 mV"))
        for column, name in enumerate(names)
    ]
    curves = [panel.all_of(Line)[0].y for panel in panels]
    np.testing.assert_allclose(
        curves, [[low, low, high, high] for low, high in ((0.06, 0.08), (0.12, 0.16), (0.48, 0.64), (0.96, 1.28))]
    )


def test_points_of_a_kind_are_joined_by_their_parameters_whatever_their_order_and_error():
    more = (
        unlike_candidate("coupled linear, order 5", "coupled linear", 31, 0.1937),
        unlike_candidate("coupled linear, order 4", "coupled linear", 23, 0.25),
    )
    found = unlike_found()
    (panel,) = error_over_parameters(replace(found, candidates=(*more, *found.candidates))).sheet.panels
    (line,) = [line for line in panel.all_of(Line) if line.label == "coupled linear"]
    assert line.x.tolist() == [17.0, 23.0, 31.0]
    assert line.y == pytest.approx([21.71, 25.0, 19.37])


@pytest.mark.parametrize(
    ("known", "drawn"),
    [([], None), ([1], 1), ([0, 2], 2), ([0, 2, 3], 2), ([1, 2, 5], 2), ([0, 1, 3, 4], 3)],
)
def test_the_response_that_is_drawn_is_the_middle_one_of_those_that_there_are(known, drawn):
    responses = [SimpleNamespace() if k in known else None for k in range(6)]
    assert words.drawn_amplitude(SimpleNamespace(responses=responses)) == drawn


@pytest.mark.parametrize(("count", "told"), [(5, (0, 2, 4)), (6, (0, 3, 5)), (7, (0, 3, 6)), (9, (0, 4, 8))])
def test_of_more_than_four_amplitudes_the_first_the_middle_and_the_last_are_told(count, told):
    said = words.by_amplitude(at_amplitudes(count))
    drives = re.findall(r"at (\S+ m?V) rms drive", said)
    every = [re.findall(r"at (\S+ m?V) rms drive", words.by_amplitude(at_amplitudes(k + 1)))[-1] for k in range(count)]
    assert drives == [every[k] for k in told]


@pytest.mark.parametrize(
    ("held", "fitted", "said"),
    [(1, 3, "r0; 3 other records were fitted"), (3, 1, "r0, r1 and r2; 1 other record was fitted")],
)
def test_records_that_were_fitted_are_one_or_several_however_many_are_held_out(found, held, fitted, said):
    names = tuple(f"r{k}" for k in range(9))
    assert words.rests_on(replace(found, held_out=names[:held], fitted=names[:fitted])) == f"This rests on {said}."


def test_an_output_whose_floor_is_not_known_has_no_line_of_it_beside_one_whose_floor_is(found, monkeypatch):
    shape = found.candidate().band_error_rms.shape
    floor, noise = np.full(shape, 1e-7), np.full(shape, np.nan)
    floor[1, :, 0], noise[0, 0, 1] = np.nan, 1e-8
    monkeypatch.setattr(words, "band_floors", lambda found: (floor, noise))
    names = [output.name for output in found.candidate().model.outputs]
    assert [row[:2] for row in coupled_page._bands(found).rows] == [
        *((f"100 mV, {names[0]}", what) for what in ("error", "best linear")),
        *((f"100 mV, {names[1]}", what) for what in ("error", "best linear", "noise")),
        (f"200 mV, {names[0]}", "error"),
        *((f"200 mV, {names[1]}", what) for what in ("error", "best linear")),
    ]
