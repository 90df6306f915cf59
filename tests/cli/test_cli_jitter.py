"""`microrad jitter`: a recording through the loop, played and as a fitted spectrum, as text and as data."""

import io
import json
import math
from contextlib import redirect_stdout
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.signal import lfilter

import several_axes
from microrad import cli
from microrad.cli import jitter as cli_jitter
from microrad.cli.frame import Refusal
from microrad.lab.recording import Motion, read_motion
from microrad.loop.disturbance.recorded_fit import fit_recording
from microrad.loop.pointing_loop.played import Played, RecordedResidual
from microrad.loop.workbench import Loop
from microrad.mirror.model import Mirror
from microrad.report.fine_pointing.recording import RecordedAxis, recording_text
from shipped import DEFAULT

RATE_HZ = 1000.0


def jitter(path, seconds=8.0, heading="time (s),x (urad)", noise=0.1):
    """A recording of noise behind a low pass of second order, with a line of 5 µrad, a mean of 30 and a slow drift."""
    time = np.arange(round(seconds * RATE_HZ)) / RATE_HZ
    white = noise * np.random.default_rng(1).standard_normal(time.size)
    motion = lfilter([1.0], [1.0, -1.8, 0.81], white) + 5.0 * np.sin(2 * math.pi * 40.0 * time) + 30.0 + 0.5 * time
    np.savetxt(path, np.column_stack([time, motion]), delimiter=",", header=heading, comments="", fmt="%.9g")
    return path


@pytest.fixture(scope="module")
def document(tmp_path_factory):
    """The data of the shipped mission with a recording."""
    recording = jitter(tmp_path_factory.mktemp("recording") / "jitter.csv")
    with redirect_stdout(io.StringIO()) as printed, pytest.raises(SystemExit) as stop:
        cli.app(args=["jitter", str(DEFAULT), str(recording), "--json"], prog_name="microrad")
    assert not stop.value.code
    return json.loads(printed.getvalue())


@pytest.mark.promise("pointing-67")
def test_a_recording_is_data_with_all_that_was_found_in_it(document):
    recording = document["recording"]
    assert {*recording} == {"file", "sha256", "rate_hz", "duration_s", "axes", "sentences"}
    (axis,) = recording["axes"]
    assert {*axis} == {
        *("name", "mean_rad", "slope_rad_s", "rms_rad", "lines", "order", "band_limited", "worst_db", "worst_at_hz"),
        *("correlation_s", "whiteness", "stationarity", "left"),
    }
    assert {*axis["whiteness"]} == {"white", "lags", "statistic", "p_value", "largest"}
    assert {*axis["stationarity"]} == {"stationary", "reason", "motion", "fast_part"}
    assert {*axis["left"]} == {
        *("begin_s", "end_s", "mean_rad", "played_rms_rad", "quietest_eighth_rms_rad", "loudest_eighth_rms_rad"),
        *("fitted_rms_rad", "sensors_rms_rad", "simulated_rms_rad", "cut_off_rms_rad", "difference", "reason"),
    }
    assert (axis["name"], recording["rate_hz"]) == ("x (urad)", pytest.approx(RATE_HZ, rel=1e-6))
    assert axis["mean_rad"] == pytest.approx(32e-6, rel=0.1) and axis["slope_rad_s"] == pytest.approx(0.5e-6, rel=0.5)
    assert [each["frequency_hz"] for each in axis["lines"]] == [pytest.approx(40.0, rel=1e-3)]
    assert axis["stationarity"]["stationary"] and axis["whiteness"]["white"]
    left = axis["left"]
    assert abs(left["difference"]) < 0.05 and left["reason"] == ""
    assert left["played_rms_rad"] == pytest.approx(left["fitted_rms_rad"] * (1.0 + left["difference"]), rel=1e-12)
    assert "x (urad): played and fitted agree within 5 %." in recording["sentences"]
    assert any("the recording ends at 500 Hz, and the loop reads up to 2.5 kHz" in s for s in recording["sentences"])


@pytest.mark.promise("readme-5")
@pytest.mark.promise("pointing-65", "pointing-67", "pointing-68")
@pytest.mark.promise("readme-23")
def test_a_recordings_tables_and_sentences_fit_a_terminal(tmp_path):
    step = 1.0 / RATE_HZ
    motion = read_motion(jitter(tmp_path / "jitter.csv", 3.0))
    fit = fit_recording(motion.samples_rad[:, 0], step, order=1, name="x")
    tests = replace(fit.stationarity, fast=replace(fit.stationarity.fast, ratio=9.0, ratio_p=0.0))
    other = replace(fit, whiteness=replace(fit.whiteness, p_value=0.0), stationarity=tests)
    played = Played(0.5, 2.9, 1e-9, 3e-6, 2.9e-6, 4e-6)
    axes = (
        RecordedAxis(fit, RecordedResidual(played, 3.01e-6, 1e-7, 3.3e-6, 2e-7, "")),
        RecordedAxis(
            other, RecordedResidual(played, 2.5e-6, 1e-7, 3.3e-6, 0.0, "the recording is not stationary: a burst")
        ),
    )
    loop = Loop(mirror=Mirror.of(50e-6, [1.0], [1 / 3000**2, 2 * 0.1 / 3000, 1.0]), rate_hz=RATE_HZ).parts
    text = recording_text("jitter.csv", axes, loop, "PI", 80)
    assert max(map(len, text.splitlines())) <= 80
    said = " ".join(text.split())
    assert "Recorded" in said and "Left by the loop under PI" in said and "radial 4.24 3.91 8.4 % 4.67" in said
    assert "x: 0.200 µrad above" in said and "half of the plant's rate, are cut off." in said
    assert "the one-step-ahead residual of the fit is not white below 400 Hz" in said
    assert "not stationary, the variance of its fast part in 8 equal parts differs 9 times" in said
    assert "in the loudest eighth the loop leaves 4.00 µrad" in said
    assert "played and fitted agree within 5 %." in said
    assert "played and fitted differ by 20 %: the recording is not stationary: a burst." in said


@pytest.mark.parametrize(
    ("made", "options", "words"),
    [
        ({}, ("--axes", "z"), "no axis"),
        ({}, ("--axes", "0,1"), "column 0 ('time (s)') is in 's', which is no angle"),
        ({"heading": "time,x (V)"}, (), "column 1 ('x (V)') is in 'V', which is no angle"),
        ({"heading": "time,x"}, (), "column 1 ('x'): no unit is stated; give it (--unit, unit)"),
        ({}, ("--unit", "mrad"), "is in 'urad' and mrad is given"),
        ({}, ("--rate", "2 kHz"), "two sample rates"),
        ({"seconds": 0.4}, (), "ten times the"),
        ({"noise": math.nan}, (), "nan"),
    ],
)
def test_a_recording_that_cannot_be_played_is_refused_in_a_line(refused, tmp_path, made, options, words):
    said = refused("jitter", DEFAULT, jitter(tmp_path / "jitter.csv", **made), *options)
    assert words in said and "jitter.csv" in said and said.count("\n") == 1


def test_a_recording_that_is_not_there_is_refused(refused):
    assert "no-such.csv" in refused("jitter", DEFAULT, "no-such.csv")


@pytest.mark.promise("mirror-file-31")
def test_a_mirror_of_several_axes_is_refused(refused, tmp_path):
    (tmp_path / "two-axes.toml").write_text(several_axes.TEXT, encoding="utf-8")
    named = several_axes.mission_text(("[fine_pointing]\n", '[fine_pointing]\nmirror_file = "two-axes.toml"\n'))
    (tmp_path / "m.toml").write_text(named, encoding="utf-8")
    assert "recordings are played to one mirror an axis" in refused("jitter", "m.toml", jitter(tmp_path / "jitter.csv"))


def test_each_axis_of_a_recording_is_fitted_by_its_own_samples_and_name(monkeypatch):
    fitted, said, refused_at = [], [], []
    samples = np.array([[1.0, 4.0, 7.0], [2.0, 5.0, 8.0]])
    motion = Motion("jitter.csv", "sha", ("x", "y", "z"), samples, 250.0)
    monkeypatch.setattr(
        "microrad.loop.disturbance.recorded_fit.fit_recording",
        lambda samples, step_s, name: fitted.append((samples.tolist(), step_s, name)) or name,
    )
    monkeypatch.setattr("microrad.loop.pointing_loop.played.refuse_short", lambda fit, s: refused_at.append((fit, s)))
    assert cli_jitter._fits(motion, 1.25, lambda *told: said.append(told)) == ["x", "y", "z"]
    assert fitted == [([1.0, 2.0], 4e-3, "x"), ([4.0, 5.0], 4e-3, "y"), ([7.0, 8.0], 4e-3, "z")]
    assert refused_at == [("x", 1.25), ("y", 1.25), ("z", 1.25)]
    assert said == [(n, 3, "fitting the recording") for n in range(3)]


def test_a_second_axis_that_is_too_short_is_refused_under_the_name_of_the_recording(monkeypatch):
    def short(fit, settle_s):
        if fit == "y":
            raise ValueError(f"{fit} ends before {settle_s:g} s")

    monkeypatch.setattr("microrad.loop.disturbance.recorded_fit.fit_recording", lambda samples, step_s, name: name)
    monkeypatch.setattr("microrad.loop.pointing_loop.played.refuse_short", short)
    motion = Motion("my jitter.csv", "sha", ("x", "y"), np.zeros((2, 2)), 250.0)
    with pytest.raises(Refusal, match=r"^my jitter\.csv: y ends before 0\.75 s$"):
        cli_jitter._fits(motion, 0.75, lambda *told: None)


@pytest.mark.parametrize(
    ("options", "names", "rate_hz", "time", "unit"),
    [
        ((), [], None, None, None),
        (("--axes", "a/x , b y", "--rate", "2.5 kHz", "--unit", "arcsec"), ["a/x", "b y"], 2500.0, None, "arcsec"),
        (("--axes", "3", "--time", "clock"), ["3"], None, "clock", None),
    ],
)
def test_a_recording_is_read_by_what_the_options_say_of_it(refused, monkeypatch, options, names, rate_hz, time, unit):
    asked = []

    def read(path, axes, rate, time, unit):
        asked.append((str(path), axes, rate, time, unit))
        raise Refusal("read")

    monkeypatch.setattr("microrad.lab.recording.read_motion", read)
    assert refused("jitter", DEFAULT, "sub/j.csv", *options) == "microrad: read\n"
    assert asked == [("sub/j.csv", names, rate_hz, time, unit)]


@pytest.mark.parametrize("as_json", [False, True])
def test_each_axis_of_a_recording_is_taken_through_the_controller_that_is_asked_for(call, monkeypatch, as_json):
    motion = Motion("sub/my jitter.csv", "5ha", ("x", "y", "z"), np.zeros((2, 3)), 250.0)
    scene = SimpleNamespace(axis="axis", table=SimpleNamespace(settle_s=0.75))
    designed = SimpleNamespace(name="LQG as designed")
    monkeypatch.setattr("microrad.lab.recording.read_motion", lambda *given, **more: motion)
    monkeypatch.setattr("microrad.loop.controller_study.scene", lambda *given: scene)
    monkeypatch.setattr("microrad.loop.controller_study.design", lambda scene, progress, names: (designed,))
    monkeypatch.setattr("microrad.loop.controller_study.on_one_axis", lambda made, scene: f"{made.name} alone")
    monkeypatch.setattr(cli_jitter, "_fits", lambda motion, settle_s, progress: [f"fit of {n}" for n in motion.names])
    monkeypatch.setattr("microrad.loop.pointing_loop.played.recorded_residual", lambda *given: given)
    told = "microrad.report.fine_pointing.recording"
    monkeypatch.setattr(f"{told}.recording_data", lambda *given: given)
    monkeypatch.setattr(f"{told}.recording_text", lambda *given: repr(given))
    monkeypatch.setattr(f"{told}.RecordedAxis", lambda fit, left: [fit, left])
    monkeypatch.setenv("COLUMNS", "99")
    result = call("jitter", DEFAULT, "j.csv", "--controller", "LQG", *["--json"] * as_json)
    axes = [[f"fit of {n}", ("axis", "LQG as designed alone", f"fit of {n}", 0.75)] for n in "xyz"]
    assert result.code == 0
    if as_json:
        data = json.loads(result.out)
        assert [*data] == ["mission_sha256", "controller", "recording"] and data["controller"] == "LQG as designed"
        left = [[fit, list(each)] for fit, each in axes]
        assert data["recording"] == ["sub/my jitter.csv", "5ha", left, "axis"]
    else:
        assert result.out == f"{('sub/my jitter.csv', axes, 'axis', 'LQG as designed', 99)!r}\n"


@pytest.mark.parametrize(
    "part",
    [
        "microrad.loop.controller_study.scene",
        "microrad.loop.controller_study.design",
        "microrad.loop.pointing_loop.played.recorded_residual",
    ],
)
def test_a_loop_that_a_recording_cannot_be_taken_through_is_refused_with_the_mission(refused, monkeypatch, part):
    def cannot(*given):
        raise ValueError("it cannot be")

    scene = SimpleNamespace(axis="axis", table=SimpleNamespace(settle_s=0.75))
    monkeypatch.setattr("microrad.lab.recording.read_motion", lambda *given, **more: None)
    monkeypatch.setattr("microrad.loop.controller_study.scene", lambda *given: scene)
    monkeypatch.setattr("microrad.loop.controller_study.design", lambda *given: ("made",))
    monkeypatch.setattr("microrad.loop.controller_study.on_one_axis", lambda *given: "alone")
    monkeypatch.setattr(cli_jitter, "_fits", lambda *given: ["fit"])
    monkeypatch.setattr(part, cannot)
    assert refused("jitter", DEFAULT, "j.csv") == f"microrad: {DEFAULT}: it cannot be\n"
