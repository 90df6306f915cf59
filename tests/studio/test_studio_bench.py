"""What the pages on mirror and control show, without a browser: forms, live fits, plots, the mirror in a mission."""

import json
import math
import re
import tomllib
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from drawn import plot_lines
from microrad.core.kernels import bouc_wen_response
from microrad.lab.identify import STATIC, identify
from microrad.lab.live_fit import LIVE_FITS, LiveFit, Loop, live_fit_writer, thin_fit
from microrad.lab.recording import RecordingError, read_recording, recording_from_arrays
from microrad.loop import controller_study
from microrad.loop import paper_cases as tracking
from microrad.loop.disturbance import Reference
from microrad.loop.pointing_loop import linear
from microrad.mission.file import load_mission
from microrad.report.tables import Table
from microrad.studio.draft.draft import Draft
from microrad.studio.draft.tables import with_mirror_file
from microrad.studio.jobs.files import Job, Progress
from microrad.studio.recordings.reading import ChannelInfo, Listing, View
from microrad.studio.views import control as control_view
from microrad.studio.views import controllers as control_model
from microrad.studio.views import mirror as mirror_view
from microrad.studio.views import mirror_form
from microrad.studio.views.controllers import PID, PID_INVERSE, WITH, WITHOUT
from microrad.studio.views.mirror_form import Dropped, Form, Setting, SettingError
from scenes import cases_of, scene_of
from shipped import SHIPPED

PAPER = np.array([0.089e-3, -2.96e-7, -0.048e-3, 0.00047, 38.421, 34.635, math.inf, 0.0])
RATE_HZ = 5000.0


def recorded(freq_hz=50.0, samples=2000):
    drive = 6.0 + 6.0 * np.sin(2 * np.pi * freq_hz * np.arange(samples) / RATE_HZ)
    output = 1e3 * bouc_wen_response(drive, 1 / RATE_HZ, PAPER, 0.0)[0]
    noise = np.random.Generator(np.random.Philox(4)).standard_normal(samples)
    return recording_from_arrays(drive, output + 0.002 * np.ptp(output) * noise, RATE_HZ, f"{freq_hz:g}Hz.csv")


@pytest.fixture(scope="module")
def identified():
    """An identification, and each model as it was handed over."""
    seen = []
    return identify([recorded()], models=STATIC[:2], on_fit=seen.append), seen


def test_a_controller_is_kept_for_the_content_of_a_mirror_file_not_for_its_name(monkeypatch):
    made = []
    monkeypatch.setattr(control_model, "_kept", {})
    monkeypatch.setattr(control_model, "_controller", lambda file, name: made.append(file.mirror_file.sha256) or name)
    monkeypatch.setattr(control_model, "with_contents", lambda file: file)
    before, anew = (
        SimpleNamespace(sha256="m", mirror_file=SimpleNamespace(sha256=each, path=Path("mirror.toml")), contents=())
        for each in "ab"
    )
    for file in (before, anew, before):
        assert control_model.controller(file, "PI") == "PI"
    assert made == ["a", "b"]


# ------------------------------------------------------------------------------------------------------------ live fits
def test_each_model_is_handed_over_as_it_is_scored_in_the_end(identified):
    found, seen = identified
    assert [each.model for each in seen] == ["prandtl_ishlinskii", "bouc_wen"]
    assert tuple(each.score for each in seen) == found.scores
    assert [each.predictions for each in seen] == list(found.predictions)
    assert seen[0].recordings == found.recordings


def test_fits_are_read_as_they_were_written(identified, tmp_path):
    _, seen = identified
    look = live_fit_writer(str(tmp_path / "progress"))
    assert mirror_view.read_fits(tmp_path) == ()
    for n, each in enumerate(seen, start=1):
        look(each)
        assert len(mirror_view.read_fits(tmp_path)) == n
    fits = mirror_view.read_fits(tmp_path)
    assert fits == tuple(thin_fit(each) for each in seen)
    loop = fits[1].loops[0]
    assert loop.name == "50Hz.csv"
    assert len(loop.drive) == len(loop.model_rad) == len(loop.measured_rad) == 200  # two periods of 100 samples
    assert np.ptp(loop.drive) == pytest.approx(12.0, rel=1e-3)
    assert loop.split_s == pytest.approx(0.2)
    assert loop.time_s[0] == pytest.approx(seen[1].predictions[0].start / RATE_HZ)
    residual = seen[1].predictions[0].residual_rad[seen[1].predictions[0].start :]
    assert max(map(abs, loop.residual_rad)) == pytest.approx(np.max(np.abs(residual)), rel=1e-6)


def test_a_line_that_is_being_written_is_left_out(identified, tmp_path):
    look = live_fit_writer(str(tmp_path / "progress"))
    look(identified[1][0])
    with (tmp_path / LIVE_FITS).open("a") as file:
        file.write('{"model": "bouc_w')
    assert [each.model for each in mirror_view.read_fits(tmp_path)] == ["prandtl_ishlinskii"]


def test_nobody_looks_on_without_a_file_and_a_disk_that_refuses_does_not_end_the_fit(identified, tmp_path):
    live_fit_writer(None)(identified[1][0])
    (tmp_path / LIVE_FITS).mkdir()
    live_fit_writer(str(tmp_path / "progress"))(identified[1][0])
    assert mirror_view.read_fits(tmp_path) == ()
    assert [each.name for each in tmp_path.iterdir()] == [LIVE_FITS]


@pytest.mark.promise("studio-12")
def test_the_command_writes_its_fits_beside_its_progress(call, folder, monkeypatch):
    """`microrad identify` hands `live_fit_writer` to `identify`: without it the page shows no live fit."""
    record = recorded()
    np.savetxt(folder / "loop.csv", np.hstack([record.drive, record.output]), delimiter=",", header="drive,angle")
    monkeypatch.setenv("MICRORAD_PROGRESS", str(folder / "progress"))
    result = call("identify", "loop.csv", "--input", "0", "--output", "1", "--rate", "5000", "--static")
    assert result.code == 0, result.err
    assert [each.model for each in mirror_view.read_fits(folder)] == ["prandtl_ishlinskii", "bouc_wen"]


def fitted(model, held_out, fit=0.5):
    loop = Loop("a.csv", (0.0, 1.0), (1e-6, 2e-6), (1e-6, 3e-6), (0.5, 1.0), (0.0, -1e-6), 0.75)
    return LiveFit(model, fit, held_out, (loop,))


def test_the_best_is_the_one_that_leaves_least_of_what_no_fit_has_seen():
    fits = fitted("a", 0.9, 0.1), fitted("b", 0.4), fitted("c", 0.6)
    assert mirror_view.best(fits).model == "b"
    assert mirror_view.best((*fits, fitted("b, free", 0.4))).model == "b, free"
    assert mirror_view.best(()) is None
    assert mirror_view.leader(fits).model == "b"
    assert mirror_view.leader((*fits, fitted("a", 0.8)), "a").held_out_rms_percent == 0.8
    assert [row[3] for row in mirror_view.score_rows(fits, "c")] == ["", "chosen", ""]
    rows = mirror_view.score_rows(fits)
    assert [row[0] for row in rows] == ["b", "c", "a"]
    assert [row[3] for row in rows] == ["best so far", "", ""]
    assert rows[0][1] == "0.4 %"


# ------------------------------------------------------------------------------------------------------------ the form
def listed(*channels, time=None, rates=()):
    infos = tuple(ChannelInfo(name, unit, 1000) for name, unit in channels)
    return Listing(infos, time, rates)


@pytest.mark.parametrize(
    ("listing", "drive", "output", "units"),
    [
        (listed(("time", "s"), ("Drive", "mV"), ("Angle", "µrad"), time=0), 1, 2, ("mV", "urad")),
        (listed(("angle [mrad]", ""), ("drive [V]", "")), 1, 0, ("V", "mrad")),
        (listed(("y", ""), ("u", "")), 1, 0, ("V", "mrad")),
        (listed(("0", ""), ("1", ""), ("2", "")), 0, 1, ("V", "mrad")),
        (listed(("only", "")), 0, None, ("V", "mrad")),
        (listed(), None, None, ("V", "mrad")),
    ],
)
def test_channels_are_guessed_by_unit_then_by_name(listing, drive, output, units):
    found = mirror_form.first_setting(listing, "loop 1.csv")
    assert (found.drive, found.output) == (drive, output)
    assert (found.drive_unit, found.output_unit) == units
    assert found.name == "loop 1-mirror"


def test_a_channel_without_samples_is_not_guessed_and_unit_and_name_together_count_most():
    empty = ChannelInfo("drive", "V", 0)
    assert mirror_form.first_setting(replace(listed(("x", "")), channels=(empty,)), "a").drive is None
    text = ChannelInfo("u", "", None)
    assert mirror_form.first_setting(replace(listed(("x", "")), channels=(empty, text)), "a").drive == 1
    for channels, drive, output in (
        ((("a", "V"), ("drive", "V"), ("b", "mrad"), ("angle", "mrad")), 1, 3),
        ((("drive", ""), ("a", "V"), ("angle", ""), ("b", "mrad")), 1, 3),
        ((("a", "V"), ("b", "mV"), ("c", "mrad"), ("d", "urad")), 0, 2),
        ((("a", ""), ("my_drive", ""), ("drive", ""), ("tilt", "")), 1, 3),
    ):
        found = mirror_form.first_setting(listed(*channels), "a")
        assert (found.drive, found.output) == (drive, output)


def test_the_form_for_the_recording_that_is_shown_already_stays_as_it_is():
    form = mirror_form.shown(Form(), IN_MRAD, "a", "a.csv", alone=True)
    typed = replace(form, setting=replace(form.setting, rate="7 Hz", output=3))
    assert mirror_form.shown(typed, IN_MRAD, "a", "a.csv") is typed
    assert mirror_form.shown(typed, IN_MRAD, "b", "b.csv").setting.rate == ""
    assert mirror_form.shown(typed, IN_MRAD, "a", "a.csv", alone=True).setting.output == 1


def test_a_unit_that_is_typed_together_with_its_channel_stays():
    form = mirror_form.shown(Form(), listed(("u", "V"), ("y", "mrad"), ("v", "mV"), ("z", "um")), "a", "a", alone=True)
    listing = listed(("u", "V"), ("y", "mrad"), ("v", "mV"), ("z", "um"))

    def units(**changes):
        found = mirror_form.edited(form, listing, replace(form.setting, **changes)).setting
        return found.drive_unit, found.output_unit

    assert units(drive=2) == ("mV", "mrad")
    assert units(output=3) == ("V", "um")
    assert units(drive_unit="mV") == ("mV", "mrad")
    assert units(output=3, output_unit="mm") == ("V", "mm")
    apart = replace(form, setting=replace(form.setting, drive_unit="mV"))
    again = mirror_form.edited(apart, listing, replace(apart.setting, drive=2, drive_unit="V")).setting
    assert (again.drive, again.drive_unit) == (2, "V")
    odd = replace(form, setting=replace(form.setting, drive_unit="mV", output_unit="um"))
    kept = mirror_form.edited(odd, listing, replace(odd.setting, rate="1 Hz")).setting
    assert (kept.drive_unit, kept.output_unit, kept.rate) == ("mV", "um", "1 Hz")  # neither channel was changed


@pytest.mark.parametrize(
    ("said", "channel"), [("0", 0), ("3", 3), ("4", 7), ("", 7), ("None", 7), ("-1", 7), ("\u00b2", 7), ("\u0663", 7)]
)
def test_a_channel_that_was_set_is_taken_where_there_is_one(said, channel):
    """The form may have come with the folder."""
    form = Form(chosen={f"{mirror_form._about(IN_MRAD)} drive": said})
    assert mirror_form._channel(form, IN_MRAD, "drive", 7) == channel
    assert mirror_form._channel(form, IN_MRAD, "output", None) is None


def test_a_channel_of_a_text_has_no_length():
    channels = (ChannelInfo("u", "V", None), ChannelInfo("1", "", 0), ChannelInfo("", "V", 5), ChannelInfo("0", "", 1))
    assert mirror_form.labels(Listing(channels, None, ())) == {
        0: "0: u (V)",
        1: "column 1, 0 samples",
        2: "column 2 (V), 5 samples",
        3: "3: 0, 1 sample",
    }


def test_a_rate_is_taken_from_the_file_where_it_states_one_alone():
    assert mirror_form.first_setting(listed(rates=(200.0,)), "a").rate == "200 Hz"
    assert mirror_form.first_setting(listed(rates=(200.0, 100.0)), "a").rate == ""
    assert mirror_form.rate_hz("") is None
    assert mirror_form.rate_hz(" 200 ") == mirror_form.rate_hz("0.2 kHz") == mirror_form.rate_hz("2e2") == 200.0
    with pytest.raises(SettingError, match=r"^sample rate: .*5 V"):
        mirror_form.rate_hz("5 V")
    for typed in ("-5", "0", "0 kHz", "-1 Hz"):
        with pytest.raises(SettingError, match=f"^sample rate: {typed} is not above 0; type a rate such as 5 kHz$"):
            mirror_form.rate_hz(typed)


def test_channels_are_called_as_the_file_calls_them():
    labels = mirror_form.labels(listed(("0", ""), ("<b>u</b>", "V")))
    assert labels == {0: "column 0, 1000 samples", 1: "1: <b>u</b> (V), 1000 samples"}
    said_twice = mirror_form.labels(listed(("angle [urad]", "urad"), ("angle [x]", "urad")))
    assert said_twice == {0: "0: angle [urad], 1000 samples", 1: "1: angle [x] (urad), 1000 samples"}


IN_MRAD = listed(("drive [V]", ""), ("angle [mrad]", ""), ("sensor [um]", ""), ("raw", ""))
IN_URAD = listed(("drive [V]", ""), ("angle [urad]", ""))
PLAYED = listed(("multisine/y", "rad"), ("multisine/u", "mV"), rates=(500.0,))


@pytest.mark.promise("studio-12")
def test_units_and_channels_are_guessed_anew_for_another_recording():
    first = mirror_form.shown(Form(), IN_MRAD, "a", "a.csv", alone=True)
    first = mirror_form.edited(first, IN_MRAD, replace(first.setting, rate="200", name="mine", static=True))
    second = mirror_form.shown(first, IN_URAD, "b", "b.csv").setting
    assert (first.setting.output_unit, second.output_unit) == ("mrad", "urad")
    assert (second.name, second.static, second.rate) == ("mine", True, "")
    third = mirror_form.shown(first, PLAYED, "c", "c.h5")
    assert third.setting == replace(second, drive=1, output=0, drive_unit="mV", output_unit="rad", rate="500 Hz")
    assert mirror_form.shown(third, IN_MRAD, "a", "a.csv").setting == first.setting  # as it was set for this one
    again = mirror_form.shown(third, IN_URAD, "d", "d.csv", alone=True)
    assert (again.setting.name, again.setting.static, again.chosen) == ("d-mirror", False, {})


def test_a_channel_brings_its_unit_unless_it_was_set_for_it():
    form = mirror_form.shown(Form(), IN_MRAD, "a", "a.csv", alone=True)

    def typed(**changes):
        nonlocal form
        form = mirror_form.edited(form, IN_MRAD, replace(form.setting, **changes))
        return form.setting.output_unit

    assert typed(output=2) == "um"
    assert typed(output=3) == "mrad"  # it states none
    assert typed(output_unit="mm") == "mm"
    assert typed(output=1) == "mrad"
    assert typed(output_unit="urad") == "urad"
    assert typed(output=3) == "mm"
    assert typed(output=1) == "urad"
    assert form.setting.drive_unit == "V"
    assert mirror_form.shown(form, IN_URAD, "b", "b.csv").setting.output == 1
    unknown = mirror_form.edited(form, None, replace(form.setting, drive=None, output=None, rate="1 Hz"))
    assert unknown == replace(
        form, setting=replace(form.setting, rate="1 Hz")
    )  # the page does not know the channels yet


@pytest.mark.promise("studio-12")
@pytest.mark.parametrize(
    ("setting", "use", "words"),
    [
        (Setting(0, 1), "fit", None),
        (
            Setting(0, 1, output_unit="urad"),
            "fit",
            "unit of the output: the form says µrad and a.csv says mrad; choose",
        ),
        (Setting(0, 1, output_unit="urad"), "check", "unit of the output: the form says µrad and a.csv says mrad"),
        (
            Setting(0, 1, drive_unit="mV"),
            "fit",
            "unit of the drive: the form says mV and a.csv says V; choose what the",
        ),
        (Setting(0, 1, output_unit="urad"), "leave", None),
        (Setting(0, 3, output_unit="urad"), "fit", None),
        (Setting(0, 4, output_unit="urad"), "fit", None),
        (Setting(0, 9, output_unit="urad"), "fit", None),
        (Setting(9, 1, drive_unit="mV"), "fit", None),
    ],
)
def test_units_that_a_recording_denies_are_refused(tmp_path, setting, use, words):
    recordings = [
        Dropped("a", "a.csv", tmp_path / "a.csv", use, IN_MRAD),
        Dropped("b", "b.csv", tmp_path / "b.csv"),
    ]
    if words is None:
        said = " ".join(mirror_form.identification(tmp_path, recordings, setting).arguments)
        assert f"--output-unit {setting.output_unit}" in said
        return
    with pytest.raises(SettingError) as refusal:
        mirror_form.identification(tmp_path, recordings, setting)
    assert words in str(refusal.value)


def test_the_reader_s_words_name_the_fields_of_the_form(tmp_path):
    np.savetxt(tmp_path / "a.csv", np.random.default_rng(1).random((400, 2)), delimiter=",")
    with pytest.raises(RecordingError) as refusal:
        read_recording(tmp_path / "a.csv", 0, 1)
    words = mirror_form.in_the_form(str(refusal.value))
    assert words.endswith("a.csv: the file does not say how fast it was sampled; type the sample rate.")
    time = np.arange(400) / 400
    clipped = np.minimum(np.sin(60 * time), 0.5)
    np.savetxt(tmp_path / "b.csv", np.stack([np.sin(60 * time), clipped], axis=1), delimiter=",")
    with pytest.raises(RecordingError, match="--accept clipping") as refusal:
        read_recording(tmp_path / "b.csv", 0, 1, 400.0)
    words = mirror_form.in_the_form(str(refusal.value))
    assert words.endswith('To take it on as it is, choose it at "Go on in spite of".')


@pytest.mark.parametrize(
    ("setting", "words"),
    [
        (Setting(None, 1), "drive: choose the channel"),
        (Setting(0, None), "output: choose the channel"),
        (Setting(2, 2), "output: channel 2 is the drive already; choose the channel of the sensor"),
        (Setting(0, 1, output_unit="um"), "lever arm: the output is a length (µm) and a mirror needs an angle"),
        (Setting(0, 1, output_unit="um", lever_arm="5 V"), 'lever arm: "5 V" is in "V"'),
        (Setting(0, 1, output_unit="um", lever_arm="-5 mm"), "lever arm: -5 mm is not above 0"),
        (Setting(0, 1, output_unit="m", lever_arm="0 mm"), "lever arm: 0 mm is not above 0; type a length such as 50"),
        (Setting(0, 1, "-5"), "sample rate: -5 is not above 0; type a rate such as 5 kHz"),
        (Setting(0, 1, name=" "), "name of the mirror: it has none; type one, such as stage-x"),
        (Setting(0, 1, name="../up"), "'../up.toml' is not taken: its name holds a path; choose another name"),
        (Setting(0, 1, name="there"), "name of the mirror: there.html is there already and is left as it is"),
    ],
)
def test_what_is_missing_in_the_form_is_said(tmp_path, setting, words):
    (tmp_path / "there.html").touch()
    recordings = [Dropped("k", "a.csv", tmp_path / "up" / "a.csv")]
    assert mirror_form.identification(tmp_path, recordings, Setting(0, 1, name="new")).results[0] == "new.toml"
    with pytest.raises(SettingError) as refusal:
        mirror_form.identification(tmp_path, recordings, setting)
    assert words in str(refusal.value)


def test_the_form_becomes_the_command(tmp_path):
    uses = {"a.csv": "fit", "b.csv": "check", "c.csv": "leave"}
    recordings = [Dropped(name, name, tmp_path / "up" / name, use) for name, use in uses.items()]
    setting = Setting(0, 4, "200 Hz", "V", "um", "50 mm", ("clipping",), True, True, "stage x")
    action = mirror_form.identification(tmp_path, recordings, setting)
    assert action.arguments[:2] == ("identify", "up/a.csv")
    said = " ".join(action.arguments)
    for option in (
        "--input 0 --output 4 --rate 200.0 --accept clipping --validate up/b.csv --input-unit V --output-unit um",
        "--lever-arm 0.05 m",
        "--name stage x --mirror-file stage x.toml",
        "--static",
        "--admissible",
    ):
        assert option in said
    assert "c.csv" not in said
    order = mirror_form.order(tmp_path, action)
    assert (order.kind, order.title, order.cwd) == ("identification", "identify stage x", tmp_path)
    assert order.arguments == (*action.arguments, "--json")
    assert order.results == ("stage x.toml", "stage x.html")
    angle = mirror_form.identification(tmp_path, recordings, replace(setting, output_unit="mrad"))
    assert "--lever-arm" not in angle.arguments
    with pytest.raises(SettingError, match="recordings: none is to be fitted; drop one, or set its use to fit"):
        mirror_form.identification(tmp_path, recordings[1:], setting)


@pytest.mark.promise("studio-8")
def test_the_form_is_kept_for_other_tabs(tmp_path):
    form = Form(Setting(1, 2, "5 kHz", accept=("drift",), name="a"), {"key": "check"})
    path = tmp_path / "form.json"
    assert mirror_form.kept_form(path) == Form()
    mirror_form.keep_form(path, form)
    assert mirror_form.kept_form(path) == form
    path.write_text('{"setting": 3}')
    assert mirror_form.kept_form(path) == Form()


def test_a_form_that_somebody_else_has_written_holds_what_can_be_chosen(tmp_path):
    path, link = tmp_path / "form.json", '<a href="https://evil.example">V</a>'
    odd = Setting(-1, -2, "5 kHz", link, link, accept=("drift", link), name="a")
    mirror_form.keep_form(path, Form(odd, {"a": "zzz", "b": "check"}, chosen={"output_unit": link}))
    assert mirror_form._possible(Form(Setting(0, 0))).setting == Setting(0, 0)
    found = mirror_form.kept_form(path)
    assert found.setting == Setting(None, None, "5 kHz", "V", "mrad", accept=("drift",), name="a")
    assert found.uses == {"b": "check"}
    assert mirror_form.shown(found, listed(("u", ""), ("y", "")), "b", "b.csv").setting.output_unit == "mrad"
    setting = Setting(0, 1, drive_unit=link, output_unit=link)
    drawn = (mirror_view.recording_plot, mirror_view.time_plot)
    titled = [title for draw in drawn for title in titles(draw(viewed(), setting))]
    titled += titles(mirror_view.loop_plot(fitted("bouc_wen", 0.4), 0, link))
    assert len(titled) == 7
    assert not any("<" in title for title in titled)


# ----------------------------------------------------------------------------------------------------------- the plots
def viewed():
    values = ((0.0, 1.0, 2.0),), ((5.0, 6.0, 7.0),)
    return View(300, 100.0, ("the output drifts",), (0, 150, 299), *values)


def titles(figure):
    axes = [axis["title"]["text"] for key, axis in figure["layout"].items() if key[1:5] == "axis"]
    return [title for title in axes if title]


def straight(figure, words):
    """Where the straight lines of this name stand on the vertical axis."""
    return [shape["y0"] for shape in figure["layout"]["shapes"] if words in shape.get("name", "")]


def test_a_recording_is_drawn_with_its_units():
    setting = Setting(0, 1, drive_unit="mV", output_unit="um")
    loop = mirror_view.recording_plot(viewed(), setting)
    assert titles(loop) == ["drive (mV)", "output (µm)"]
    assert (loop["data"][0]["x"], loop["data"][0]["y"]) == ([0.0, 1.0, 2.0], [5.0, 6.0, 7.0])
    over_time = mirror_view.time_plot(viewed(), setting)
    assert titles(over_time) == ["drive (mV)", "time (s)", "output (µm)"]
    assert over_time["data"][1]["x"] == [0.0, 1.5, 2.99]
    assert mirror_view.about(viewed()) == "300 samples at 100 Hz, 3 s."
    assert mirror_view.findings(viewed()) == ["The output drifts."]
    assert mirror_view.findings(replace(viewed(), findings=("µ is flat", "a.", ""))) == ["µ is flat.", "A.", "."]
    assert mirror_view.about(replace(viewed(), samples=1)) == "1 sample at 100 Hz, 10 ms."
    assert not loop["config"]["displaylogo"]


@pytest.mark.promise("studio-12")
def test_a_model_is_drawn_over_what_was_measured():
    fit = fitted("bouc_wen", 0.4)
    figure = mirror_view.loop_plot(fit, 0, "V")
    assert [trace["name"] for trace in figure["data"]] == ["measured", "bouc_wen"]
    assert figure["data"][0]["y"] == [1.0, 2.0]
    assert figure["data"][1]["y"] == [1.0, 3.0]
    assert titles(figure) == ["drive (V)", "angle (µrad)"]
    residual = mirror_view.residual_plot(fit, 0)
    assert residual["data"][0]["y"] == [0.0, -1.0]
    assert (residual["layout"]["shapes"][0]["x0"], residual["layout"]["shapes"][0]["x1"]) == (0.75, 1.0)


def test_the_state_of_an_identification_in_words(tmp_path):
    job = Job(1, tmp_path, "running", "identification", arguments=("identify", "a", "--input-unit", "mV"))
    said = mirror_view.state_words
    assert said(job, None) == "Begins."
    busy = replace(job, progress=Progress(3, 14, "Bouc-Wen starts"))
    assert said(busy, None) == "3 of 14 fits: fitting bouc_wen, start by start."
    best = fitted("bouc_wen", 0.4)
    assert said(replace(busy, cancelling=True), best) == (
        "3 of 14 fits: fitting bouc_wen, start by start, stopping. "
        "Best so far: bouc_wen, 0.4 % rms on samples that no fit has seen."
    )
    assert said(replace(job, state="failed", words="no recording"), None) == "failed: no recording"
    assert said(replace(job, state="done"), best).startswith("Done. Chosen: bouc_wen, 0.4 %")
    assert mirror_view.argument(job, "--input-unit", "V") == "mV"
    assert mirror_view.argument(job, "--rate", "none") == "none"


def test_the_outcome_is_read_from_what_the_command_prints():
    said = {"model": "m", "verdict": ["a"], "warnings": ["b"], "refused": {"c": "why"}}
    found = mirror_view.outcome(json.dumps(said))
    model, (verdict, warned, refused) = found
    assert (model, verdict, warned.lines, refused.lines) == ("m", "a", ["Warning: b"], ["Not fitted: c: why"])
    for damaged in ("", "{", "[]", 100_000 * "[", '{"model": "m"}', '{"model": "m", "verdict": 1}'):
        assert mirror_view.outcome(damaged) is None
    assert mirror_view.outcome(json.dumps({**said, "refused": {}})) == ("m", ("a", warned))


# ---------------------------------------------------------------------------------------------- the mirror in a mission
MIRROR = """name = "identified"
travel = "1 mrad"
composition = "static"
rate_limit = "100 V/s"
bias = "5 V"
drive_min = "0 V"
drive_max = "10 V"
[prandtl_ishlinskii]
thresholds = ["0 V", "1 V"]
weights = ["80 urad/V", "9 urad/V"]
"""


@pytest.mark.promise("studio-12")
def test_a_mission_takes_an_identified_mirror_and_keeps_the_rest(tmp_path):
    (tmp_path / "found").mkdir()
    (tmp_path / "found" / "stage.toml").write_text(MIRROR)
    before = Draft.shipped(tmp_path / "m.toml")
    after = with_mirror_file(before, tmp_path / "found" / "stage.toml")
    assert after.problems == ()
    assert after.file().mission.mirror.name == "identified"
    begin, end = before.text.index("[mirror]"), before.text.index("\n[amplifier]")
    assert after.text == before.text[:begin] + '[mirror]\nfile = "found/stage.toml"\n' + before.text[end:]
    assert with_mirror_file(after, tmp_path / "found" / "stage.toml").text == after.text
    away = with_mirror_file(before, tmp_path / "gone.toml")
    assert "the mirror file does not exist" in away.report


def test_line_ends_and_byte_order_mark_stay(tmp_path):
    text = "\ufeff" + Draft.shipped(tmp_path / "m.toml").text.replace("\n", "\r\n")
    (tmp_path / "m.toml").write_bytes(text.encode())
    (tmp_path / "stage.toml").write_text(MIRROR)
    after = with_mirror_file(Draft.open(tmp_path / "m.toml"), tmp_path / "stage.toml")
    assert after.problems == ()
    assert after.text.startswith("\ufeff#")
    assert '\r\n[mirror]\r\nfile = "stage.toml"\r\n\r\n[amplifier]\r\n' in after.text
    assert after.text.count("\n") == after.text.count("\r\n")


def test_a_mirror_in_two_places_of_the_text_and_one_that_is_missing(tmp_path):
    draft = Draft.shipped(tmp_path / "m.toml")
    apart = draft.with_text('[mirror]\nname = "a"\n[amplifier]\ngain = 2\n# kept\n[mirror.linear]\n[other]')
    assert with_mirror_file(apart, tmp_path / "s.toml").text == (
        '[mirror]\nfile = "s.toml"\n[amplifier]\ngain = 2\n# kept\n[other]'
    )
    without = draft.with_text("[amplifier]\ngain = 2")
    assert with_mirror_file(without, tmp_path / "s.toml").text == (
        '[amplifier]\ngain = 2\n\n[mirror]\nfile = "s.toml"\n'
    )
    for text, lead in (("", "\n"), ("[amplifier]\n", "[amplifier]\n\n"), ("[mirrors]", "[mirrors]\n\n")):
        assert with_mirror_file(draft.with_text(text), tmp_path / "s.toml").text == f'{lead}[mirror]\nfile = "s.toml"\n'
    for lead in ("", " ", "\t"):
        indented = draft.with_text(f'a = 1\n{lead}[mirror]\n{lead}name = "a"\n[other]')
        assert with_mirror_file(indented, tmp_path / "s.toml").text == 'a = 1\n[mirror]\nfile = "s.toml"\n[other]'
    windows = with_mirror_file(replace(draft, text="a = 1\r\nb = 1"), tmp_path / "s.toml").text
    assert windows == 'a = 1\r\nb = 1\r\n\r\n[mirror]\r\nfile = "s.toml"\r\n'
    inline = draft.with_text('[mirror]\nnot toml\nname = "a"\n\n[mirror.linear]\n# gone\nx = 1\nnot toml\n[other]')
    assert with_mirror_file(inline, tmp_path / "s.toml").text == '[mirror]\nfile = "s.toml"\nnot toml\n[other]'


# ------------------------------------------------------------------------------------------------------------- control
@pytest.fixture(scope="module")
def mission():
    return load_mission(SHIPPED)


@pytest.fixture(scope="module")
def pi(mission):
    return control_model.controller(mission, "PI")


@pytest.fixture(scope="module")
def answers(pi):
    return pi.ask(control_view.ask_of("100 urad", "300 urad", "15 Hz", 5000.0), (WITH, WITHOUT))


@pytest.mark.promise("studio-12")
def test_the_controllers_are_those_of_the_study_and_of_control(mission):
    names = control_model.names(mission.mission.fine_pointing)
    assert names == (*controller_study.names(mission.mission.fine_pointing), PID, PID_INVERSE)
    assert control_model.names(None) == (PID, PID_INVERSE)
    with pytest.raises(ValueError, match="'none' is no controller of this mission"):
        control_model.controller(mission, "none")


@pytest.mark.promise("readme-15")
@pytest.mark.promise("studio-12")
def test_a_tuned_controller_has_the_numbers_of_the_study(mission, pi):
    scene = scene_of(mission)
    tuned = controller_study.tune("PI", scene.table, controller_study.plants(scene, scene.table.seed))
    assert pi.residual_rad == tuned.residual_rms_rad
    assert (pi.margins.modulus, pi.margins.gain_up) == (tuned.margins.modulus, tuned.margins.gain_up)
    assert pi.margins.modulus >= pi.asked_modulus == scene.table.modulus_margin
    assert pi.tuned == ", ".join(f"{name} {value:.3g} Hz" for name, value in tuned.values.items())
    closed = linear.close(scene.loop, controller_study.build("PI", scene, tuned.controller))
    at = np.array([10.0, 100.0, 1000.0])
    expected = np.abs(linear.sensitivity(closed, at)[:, 0, 0])
    np.testing.assert_allclose(np.interp(at, pi.freq_hz, pi.sensitivity), expected, rtol=2e-3)
    assert pi.sensitivity.max() == pytest.approx(pi.margins.peak, rel=1e-2)


def test_a_controller_is_tuned_once_for_a_text(mission, pi, tmp_path):
    assert control_model.controller(load_mission(SHIPPED), "PI") is pi
    text = SHIPPED.read_text("utf-8").replace("modulus_margin = 0.5", "modulus_margin = 0.6")
    other = load_mission(tmp_path / "m.toml", text=text)
    found = control_model.controller(other, "PI")
    assert (found.asked_modulus, pi.asked_modulus) == (0.6, 0.5)
    assert control_model.controller(load_mission(SHIPPED), "PI") is pi


@pytest.mark.promise("studio-12")
def test_step_sine_and_jitter_answer_what_they_are_asked(mission, pi, answers):
    step = answers.step[WITHOUT]
    assert step.found_rad[0] == 0.0
    assert step.found_rad[-1] == pytest.approx(100e-6, rel=0.02)
    assert step.time_s[0] == 0.0
    sine = answers.sine[WITH]
    assert np.ptp(sine.wanted_rad) == pytest.approx(600e-6, rel=1e-2)
    assert sine.time_s[-1] - sine.time_s[0] == pytest.approx(2 / 15, rel=1e-2)
    assert sine.time_s[0] == pytest.approx(0.4, abs=1e-3)  # what settles is left out
    assert 0 < sine.rms_rad < sine.peak_rad < 300e-6
    jitter = answers.jitter[WITH]
    table = mission.mission.fine_pointing
    assert jitter.time_s[0] == pytest.approx(table.settle_s)
    assert jitter.disturbance_rad.std() > 5 * jitter.error_rad.std()
    residual = math.sqrt(2.0) * pi.residual_rad  # of both axes, linear, without hysteresis
    assert 0.85 * residual < answers.jitter[WITHOUT].rms_rad < 1.15 * residual
    assert jitter.rms_rad > answers.jitter[WITHOUT].rms_rad  # the same noise, and hysteresis
    for curves in (answers.step, answers.sine, answers.jitter):
        assert set(curves) == {WITH, WITHOUT}
        assert all(np.all(np.abs(c.drive_v) <= pi.limits_v[1]) for c in curves.values())


def test_only_the_variants_that_are_asked_for_are_simulated(pi):
    ask = control_view.ask_of("50 urad", "100 urad", "25 Hz", 5000.0)
    found = pi.ask(ask, control_view.SHOWN["without"])
    assert {*found.step, *found.sine, *found.jitter} == {WITHOUT}


@pytest.mark.parametrize("name", [PID, PID_INVERSE])
def test_the_paper_s_loop_has_the_numbers_of_the_study(mission, name):
    found = control_model.controller(mission, name)
    margins = tracking.loop_margins(cases_of(mission.mission))
    assert found.margins.modulus == margins.modulus
    assert found.margins.crossover_hz == margins.crossover_hz
    assert found.margins.bandwidth_hz == pytest.approx(358, rel=0.02)
    asked = found.ask(control_view.ask_of("100 urad", "300 urad", "15 Hz", 5000.0), (WITH, WITHOUT))
    runs = tracking.sine_runs(cases_of(mission.mission))
    kind = "PID" if name == PID else "PID + inverse"
    for variant, which in ((WITH, "given"), (WITHOUT, "no hysteresis")):
        run = next(r for r in runs if (r.mirror, r.controller, r.freq_hz) == (which, kind, 15.0))
        assert asked.sine[variant].peak_rad == pytest.approx(run.trace.peak_rad, rel=1e-2)
    assert asked.jitter == {}
    assert asked.step[WITHOUT].found_rad[-1] == pytest.approx(100e-6, rel=0.02)


def test_a_step_beyond_the_sensor_s_field_of_view_says_why_the_loop_stands_still(mission, pi):
    assert pi.field_of_view_rad == mission.mission.fine_pointing.optical_sensor.field_of_view_rad == 2e-3
    assert (pi.rate_hz, control_model.controller(mission, PID).field_of_view_rad) == (5000.0, math.inf)
    curves = pi.ask(control_view.ask_of("100 mrad", "300 urad", "15 Hz", pi.rate_hz), (WITHOUT,)).step
    assert np.all(curves[WITHOUT].drive_v == 0.0)
    lost = "The sensor sees errors up to 2 mrad: beyond, it holds its last reading, and the loop does not act."
    assert control_view.answer_words(curves, "Error", pi.field_of_view_rad).endswith(f"at most 100 mrad. {lost}")
    assert control_view.answer_words(curves, "Error").endswith("at most 100 mrad.")


@pytest.mark.promise("studio-12")
def test_the_warnings_of_the_mirror_s_file_stand_beside_the_margins(mission, pi, tmp_path):
    text = "# Mirror identified.\n# Warning: Not valid above 18.85 V/s.\n# Warning: b.\n" + MIRROR
    (tmp_path / "stage.toml").write_text(text)
    draft = with_mirror_file(Draft.shipped(tmp_path / "m.toml"), tmp_path / "stage.toml")
    warned = control_model.mirror_warnings(False, draft.file().mirror_file.text)
    assert warned == (
        "The mirror has no linear part: its dynamics are not known, and margins and answers are those of one without "
        "any.",
        "Warning of the mirror's file: Not valid above 18.85 V/s.",
        "Warning of the mirror's file: b.",
    )
    assert control_model.mirror_warnings(True, "") == pi.warnings == ()
    assert control_view.notes(replace(pi, warnings=warned)) == warned


def test_margins_in_words_against_what_is_asked_for(mission, pi):
    pid = control_model.controller(mission, PID)
    bound = replace(pi, bound_by=("modulus margin",), sensitivity=None, loop_gain=None)
    found = {"PI": pi, PID: pid, "PID": "being tuned ...", "bound": bound}
    table = next(block for block in control_model.blocks(found) if isinstance(block, Table))
    rows = [dict(zip(table.headings, row, strict=True)) for row in table.rows]
    first, second, waiting, last = rows
    assert [row["controller"] for row in rows] == [*found]
    residual = "residual of an axis,\nrms in theory (µrad)"
    assert float(first[residual]) == pytest.approx(1e6 * pi.residual_rad, rel=5e-3)
    assert (second[residual], waiting[residual]) == ("", "")
    assert re.fullmatch(r"integral frequency \d+ Hz, zero \d+ Hz", first["tuned to"])
    assert (second["tuned to"], waiting["tuned to"]) == ("the gains of [control]", "being tuned ...")
    assert (first["modulus"], second["modulus"]) == (f"{pi.margins.modulus:.2f}", f"{pid.margins.modulus:.2f}")
    assert float(first["phase (°)"]) == pytest.approx(math.degrees(pi.margins.phase_rad), abs=0.5)
    assert {waiting[heading] for heading in table.headings[3:]} == {""}
    assert (first["bound by"], last["bound by"]) == ("nothing", "modulus margin")
    assert control_view.notes(pi) == ()
    assert "nothing shakes it" in control_view.notes(pid)[0]
    assert "slower than the control" in control_view.notes(bound)[0]
    assert control_view.sensitivity_plot(bound)["data"] == control_view.gain_plot(bound)["data"] == []


def test_a_controller_has_the_amplifiers_limits_and_the_identified_range(monkeypatch):
    """Neither is the other: a mirror may have been identified over a part of what its amplifier gives."""
    tuned = SimpleNamespace(
        controller=None, margins=SimpleNamespace(bandwidth_hz=100.0), values={}, residual_rms_rad=0.0, bound_by=()
    )
    for name, made in (("plants", [None]), ("tune", tuned), ("build", None)):
        monkeypatch.setattr(controller_study, name, lambda *given, made=made: made)
    family = SimpleNamespace(name="PI", parameters=lambda plant: [])
    monkeypatch.setattr(control_model, "families", lambda table: [family])
    monkeypatch.setattr(control_model, "_responses", lambda *given: (None, None))
    loop = SimpleNamespace(
        timing=SimpleNamespace(period_s=1e-4),
        drive=SimpleNamespace(minimum_v=-6.0, maximum_v=7.0),
        drive_range_v=(-3.0, 4.0),
        optical=SimpleNamespace(field_of_view_rad=1e-3),
    )
    scene = SimpleNamespace(table=SimpleNamespace(seed=1, modulus_margin=0.5), loop=loop)
    found = control_model._fine(scene, "PI")
    assert (found.limits_v, found.identified_v) == ((-6.0, 7.0), (-3.0, 4.0))
    assert found.rate_hz == pytest.approx(1e4)


@pytest.mark.promise("studio-12")
def test_plots_carry_units_limits_and_both_variants(pi, answers):
    shown = {
        control_view.step_plot: ("time (ms)", "line of sight, axis x (µrad)"),
        control_view.sine_plot: ("time (ms)", "error, axis x (µrad)"),
        control_view.jitter_plot: ("time (s)", "error, axis x (µrad)"),
        control_view.motion_plot: ("time (s)", "angle, axis x (µrad)"),
    }
    for draw, axes in shown.items():
        figure = draw(answers)
        assert tuple(titles(figure)) == axes
        assert figure["layout"]["yaxis"]["minexponent"] == 5  # no "100k" µrad
        assert [t["name"] for t in figure["data"] if "hysteresis" in t["name"]] == [WITH, WITHOUT]
        assert all(len(t["x"]) == len(t["y"]) <= 2500 for t in figure["data"])
    drive = control_view.drive_plot(pi, answers.jitter, control_view.SECONDS)
    assert straight(drive, "amplifier's limits") == [*pi.limits_v] == [-6.0, 6.0]
    apart = control_view.drive_plot(replace(pi, identified_v=(-3.0, 3.0)), answers.step)
    assert straight(apart, "range of the identification") == [-3.0, 3.0]
    assert straight(control_view.sensitivity_plot(pi), "margin asked for") == [2.0]
    assert titles(control_view.gain_plot(pi)) == ["frequency (Hz)", "|L|, loop gain"]
    assert control_view.answer_words(answers.step, "Error").startswith(f"Error: {WITH} ")
    assert control_view.answer_words({}, "Error") == ""


def made(**changes):
    """A controller of three frequencies that nobody has tuned."""
    margins = SimpleNamespace(bandwidth_hz=20.0, crossover_hz=30.0)
    freq, one = np.array([1.0, 10.0, 100.0]), np.array([0.5, 1.0, 2.0])
    limits = ((-6.0, 6.0), (-6.0, 6.0), 5000.0, 2e-3)
    found = control_view.Controller("PI", margins, "", 1e-6, (), 0.5, freq, one, one, *limits, (), None)
    return replace(found, **changes)


def curve(error_rad, begin_s=0.0, **changes):
    """Two samples of one axis."""
    time_s, wanted = begin_s + np.array([0.0, 2e-3]), np.array([1e-6, 1e-6])
    error, drive = np.array([[0.0], [error_rad]]), np.array([[1.0], [2.0]])
    return replace(control_view.Curve(time_s, wanted, wanted - error[:, 0], error, drive), **changes)


@pytest.mark.parametrize(("asked", "rules"), [(0.5, [2.0]), (math.nan, []), (1.0, [1.0])])
def test_the_margin_asked_for_is_drawn_where_one_was(asked, rules):
    assert straight(control_view.sensitivity_plot(made(asked_modulus=asked)), "margin asked for") == rules


@pytest.mark.parametrize(("at", "drawn"), [(20.0, True), (math.inf, False), (math.nan, False), (0.0, False)])
def test_the_frequency_of_a_margin_is_drawn_where_there_is_one(at, drawn):
    of = made(margins=SimpleNamespace(bandwidth_hz=at, crossover_hz=at))
    for draw, name in ((control_view.sensitivity_plot, "bandwidth"), (control_view.gain_plot, "crossover")):
        shapes = draw(of)["layout"]["shapes"]
        assert [each["x0"] for each in shapes if name in each.get("name", "")] == [20.0] * drawn
        assert [each.get("name") for each in shapes if name in each.get("name", "")] == [f"{name} 20 Hz"] * drawn


def test_what_is_to_be_followed_is_drawn_where_something_is():
    still, shaken = curve(1e-6), curve(1e-6, disturbance_rad=np.array([[2e-6], [3e-6]]))
    for curves, names in (
        ({WITH: still}, [WITH]),
        ({WITH: shaken, WITHOUT: shaken}, ["to be followed", WITH, WITHOUT]),
        ({WITH: still, WITHOUT: shaken}, ["to be followed", WITH, WITHOUT]),
    ):
        drawn = control_view.motion_plot(control_view.Answers({}, {}, curves))
        assert [trace["name"] for trace in drawn["data"]] == names
    assert drawn["data"][0]["y"] == [2.0, 3.0]
    nothing = control_view.Answers({}, {}, {})
    for draw in (control_view.motion_plot, control_view.jitter_plot, control_view.step_plot, control_view.sine_plot):
        assert draw(nothing)["layout"]["annotations"][0]["text"].startswith("Nothing disturbs this loop, or nothing")


def test_the_wanted_angle_of_a_step_is_drawn_once():
    drawn = control_view.step_plot(control_view.Answers({WITH: curve(0.0), WITHOUT: curve(1e-6)}, {}, {}))
    assert [(each["name"], each["y"]) for each in drawn["data"]] == [
        ("wanted", [1.0, 1.0]),
        (WITH, [1.0, 1.0]),
        (WITHOUT, [1.0, 0.0]),
    ]


def test_a_drive_is_drawn_over_the_time_that_is_asked_for_within_finite_limits():
    assert control_view.drive_plot(made(), {})["layout"]["annotations"][0]["text"].startswith("Nothing disturbs")
    curves = {WITH: curve(1e-6, begin_s=0.5)}
    over_ms, over_s = (control_view.drive_plot(made(), curves, *axis) for axis in ((), (control_view.SECONDS,)))
    assert (over_ms["data"][0]["x"], over_s["data"][0]["x"]) == ([0.0, 2.0], [0.5, 0.502])
    assert over_ms["data"][0]["y"] == [1.0, 2.0]
    assert titles(over_ms)[0] == "time (ms)"
    assert straight(over_ms, "range of the identification") == []
    open_end = made(limits_v=(-math.inf, 6.0), identified_v=(0.0, math.inf))
    shown = control_view.drive_plot(open_end, curves)
    assert straight(shown, "amplifier's limits") == [6.0]
    assert straight(shown, "range of the identification") == [0.0]


@pytest.mark.parametrize(("peaks", "lost"), [((2e-3,), False), ((2.001e-3,), True), ((1e-3, 3e-3), True), ((), False)])
def test_a_sensor_loses_sight_only_beyond_its_field_of_view(peaks, lost):
    curves = {variant: curve(peak) for variant, peak in zip((WITH, WITHOUT), peaks, strict=False)}
    words = control_view.answer_words(curves, "Error", 2e-3)
    assert ("The sensor sees errors up to 2 mrad: beyond" in words) == lost
    assert words.startswith("Error: with hysteresis") == bool(peaks)


def test_rms_and_peak_are_those_of_the_radial_error():
    error = np.array([[3e-6, 4e-6], [0.0, 0.0]])
    found = replace(curve(0.0), error_rad=error)
    assert found.peak_rad == pytest.approx(5e-6)
    assert found.rms_rad == pytest.approx(5e-6 / math.sqrt(2.0))


@pytest.mark.parametrize(
    ("asked", "told"),
    [
        (("1 nrad", "100 mrad", "0.1 Hz"), None),
        (("100 mrad", "1 nrad", "10 kHz"), None),
        (("0.99 nrad", "1 urad", "1 Hz"), "step: 0.99 nrad is outside 1 nrad to 100 mrad"),
        (("1 urad", "101 mrad", "1 Hz"), "amplitude of the sine: 101 mrad is outside 1 nrad to 100 mrad"),
        (("1 urad", "1 urad", " 0.099 Hz "), "frequency of the sine: 0.099 Hz is outside 100 mHz to 10 kHz"),
        (("1 urad", "1 urad", "10.1 kHz"), "frequency of the sine: 10.1 kHz is outside 100 mHz to 10 kHz"),
    ],
)
def test_what_is_asked_may_lie_at_the_very_ends(asked, told):
    if told is None:
        found = control_view.ask_of(*asked, 50_000.0)
        assert (found.step_rad, found.sine_rad) == pytest.approx((1e-9, 0.1) if asked[0] == "1 nrad" else (0.1, 1e-9))
        assert found.seed == 1
        return
    with pytest.raises(control_view.AskError) as refusal:
        control_view.ask_of(*asked, 50_000.0)
    assert str(refusal.value) == f"{told}; type one between"


def test_only_so_many_controllers_are_kept_the_last_ones(monkeypatch):
    asked = []
    monkeypatch.setattr(control_model, "_kept", {})
    monkeypatch.setattr(control_model, "_MOST_KEPT", 2)
    monkeypatch.setattr(control_model, "_controller", lambda file, name: asked.append(name) or name)
    monkeypatch.setattr(control_model, "with_contents", lambda file: file)
    file = SimpleNamespace(sha256="m", mirror_file=None, contents=())
    assert [control_model.controller(file, name) for name in "abacba"] == [*"abacba"]
    assert asked == [*"abca"]


def test_a_sensor_that_is_slower_than_the_control_has_no_response_by_frequency():
    slow = SimpleNamespace(optical=SimpleNamespace(every=2))
    assert control_model._responses(slow, None, np.array([1.0])) == (None, None)


def test_the_mirror_s_own_file_and_its_missing_dynamics_are_told_with_a_controller(tmp_path):
    (tmp_path / "stage.toml").write_text("# Warning: odd.\n" + MIRROR)
    draft = with_mirror_file(Draft.shipped(tmp_path / "m.toml"), tmp_path / "stage.toml")
    found = control_model.controller(draft.file(), PID)
    assert found.warnings == control_model.mirror_warnings(False, "# Warning: odd.")
    assert len(found.warnings) == 2


@pytest.mark.promise("studio-12")
@pytest.mark.parametrize(
    ("typed", "words"),
    [
        (("5 V", "1 urad", "1 Hz"), 'step: "5 V" is in "V"'),
        (("1 urad", "2", "1 Hz"), 'amplitude of the sine: "2" is a number without a unit'),
        (("1 urad", "0 urad", "1 Hz"), "amplitude of the sine: 0 urad is outside 1 nrad to 100 mrad; type one between"),
        (("1 urad", "1 urad", "20 kHz"), "frequency of the sine: 20 kHz is outside 100 mHz to 10 kHz"),
        (
            ("1 urad", "1 urad", "2.5 kHz"),
            "frequency of the sine: 2.5 kHz is not below 2.5 kHz, half the rate of the loop, 5 kHz",
        ),
    ],
)
def test_what_cannot_be_asked_is_said(typed, words):
    assert control_view.ask_of("1 urad", "1 urad", "2.49 kHz", 5000.0).sine_hz == 2490.0
    assert control_view.ask_of("1 urad", "1 urad", "1 Hz", 5000.0).sine_hz == 1.0
    with pytest.raises(control_view.AskError) as refusal:
        control_view.ask_of(*typed, 5000.0)
    assert words in str(refusal.value)


# ------------------------------------------------------------------------------- several axes, drives and recordings
def two_axes(begin_s=0.25):
    """Three samples of two axes under three drives, no two numbers alike."""
    return control_view.Curve(
        begin_s + np.array([0.0, 1e-3, 4e-3]),
        np.array([1e-6, 2e-6, 3e-6]),
        np.array([4e-6, 5e-6, 7e-6]),
        1e-6 * np.array([[11.0, 21.0], [12.0, 22.0], [13.0, 24.0]]),
        np.array([[0.5, 1.5, 2.5], [0.6, 1.6, 2.6], [0.7, 1.7, 2.7]]),
        1e-6 * np.array([[31.0, 41.0], [32.0, 42.0], [34.0, 43.0]]),
    )


@pytest.mark.parametrize(
    ("draw", "titled", "first", "traces"),
    [
        ("step", ("time (ms)", "line of sight, axis x (µrad)"), [0.0, 1.0, 4.0], [[1.0, 2.0, 3.0], [4.0, 5.0, 7.0]]),
        ("sine", ("time (ms)", "error, axis x (µrad)"), [0.0, 1.0, 4.0], [[11.0, 12.0, 13.0]]),
        ("jitter", ("time (s)", "error, axis x (µrad)"), [0.25, 0.251, 0.254], [[11.0, 12.0, 13.0]]),
        ("motion", ("time (s)", "angle, axis x (µrad)"), [0.25, 0.251, 0.254], [[31.0, 32.0, 34.0], [4.0, 5.0, 7.0]]),
    ],
)
def test_of_a_run_of_two_axes_the_first_is_drawn(draw, titled, first, traces):
    answers = control_view.Answers(*({WITH: two_axes()},) * 3)
    figure = getattr(control_view, f"{draw}_plot")(answers)
    assert tuple(titles(figure)) == titled
    assert [trace["x"] for trace in figure["data"]] == [first] * len(traces)
    assert [trace["y"] for trace in figure["data"]] == [pytest.approx(each) for each in traces]


def test_of_three_drives_the_first_is_drawn_between_unequal_limits():
    of = made(limits_v=(-6.0, 7.0), identified_v=(-3.0, 4.0))
    figure = control_view.drive_plot(of, {WITHOUT: two_axes()}, control_view.SECONDS)
    (trace,) = figure["data"]
    assert (trace["name"], trace["y"]) == (WITHOUT, [0.5, 0.6, 0.7])
    assert trace["x"] == [0.25, 0.251, 0.254]
    assert titles(figure) == ["time (s)", "drive from the bias (V)"]
    assert straight(figure, "amplifier's limits") == [-6.0, 7.0]
    assert straight(figure, "range of the identification") == [-3.0, 4.0]


def test_the_variants_of_a_mirror_are_told_apart_by_colour_and_dash():
    figure = control_view.sine_plot(control_view.Answers({}, {WITHOUT: curve(1e-6), WITH: curve(2e-6)}, {}))
    drawn = {each["name"]: (each["line"]["color"].lower(), each["line"]["dash"]) for each in figure["data"]}
    assert drawn[WITH][1] == "solid" and drawn[WITHOUT][1] != "solid"
    assert drawn == {
        WITH: (control_view.VERMILION.lower(), drawn[WITH][1]),
        WITHOUT: (control_view.BLUE.lower(), drawn[WITHOUT][1]),
    }


def test_a_response_is_drawn_from_its_least_but_no_deeper_than_eighty_decibels():
    deep = made(sensitivity=np.array([1e-7, 0.02, 3.0]), loop_gain=np.array([40.0, 0.5, 0.004]))
    sensitivity, gain = control_view.sensitivity_plot(deep), control_view.gain_plot(deep)
    ranges = [[figure["layout"][axis]["range"] for axis in ("xaxis", "yaxis")] for figure in (sensitivity, gain)]
    assert ranges[0] == [[0, 2], pytest.approx([-4.0, math.log10(3.9)], rel=1e-4)]
    assert ranges[1] == [[0, 2], pytest.approx([math.log10(0.004), math.log10(52.0)], rel=1e-4)]
    assert (titles(sensitivity)[1], titles(gain)[1]) == ("|S|, error over disturbance", "|L|, loop gain")
    named = [[s["name"] for s in figure["layout"]["shapes"] if s.get("name")] for figure in (sensitivity, gain)]
    assert named == [["1 / modulus margin asked for (0.5)", "bandwidth 20 Hz"], ["crossover 30 Hz"]]
    assert (straight(sensitivity, "asked for"), gain["data"][0]["y"]) == ([2.0], [40.0, 0.5, 0.004])


def test_everything_that_has_to_be_known_of_a_controller_is_said_in_its_order():
    of = made(name=PID_INVERSE, sensitivity=None, warnings=("one", "two"))
    assert control_view.notes(of) == (
        "The gains of [control] as they stand in the mission: this loop is not tuned, and nothing shakes it.",
        "The optical sensor is slower than the control: the loop has no response by frequency of its own.",
        "one",
        "two",
    )


def test_the_errors_of_both_variants_are_told_in_one_sentence():
    curves = {WITH: curve(3e-6), WITHOUT: replace(curve(0.0), error_rad=np.array([[3e-6, 0.0], [0.0, 5e-6]]))}
    assert control_view.answer_words(curves, "Radial error", 4.5e-6) == (
        "Radial error: with hysteresis 2.12 µrad rms, at most 3.00 µrad; without hysteresis 4.12 µrad rms, "
        "at most 5.00 µrad."
        " The sensor sees errors up to 4.5 µrad: beyond, it holds its last reading, and the loop does not act."
    )


def fits_of_two():
    """Two models of two recordings, all numbers unlike."""
    loops = [
        Loop("a.csv", (0.0, 1.0), (1e-6, 2e-6), (3e-6, 4e-6), (0.5, 1.5), (5e-6, 6e-6), 0.75),
        Loop("b.csv", (7.0, 8.0), (9e-6, 10e-6), (11e-6, 12e-6), (2.5, 3.5), (13e-6, -14e-6), 3.25),
    ]
    return LiveFit("one", 0.125, 0.25, tuple(loops)), LiveFit("two", 0.875, 0.75, tuple(reversed(loops)))


def test_the_second_recording_of_a_model_is_drawn_with_its_own_samples():
    first, second = fits_of_two()
    loop, residual = mirror_view.loop_plot(first, 1, "mV"), mirror_view.residual_plot(first, 1)
    assert [(t["name"], t["x"], t["y"]) for t in loop["data"]] == [
        ("measured", [7.0, 8.0], [9.0, 10.0]),
        ("one", [7.0, 8.0], [11.0, 12.0]),
    ]
    assert titles(loop) == ["drive (mV)", "angle (µrad)"]
    (trace,) = residual["data"]
    assert (trace["name"], trace["x"], trace["y"]) == ("measured less model", [2.5, 3.5], [13.0, -14.0])
    (unseen,) = residual["layout"]["shapes"]
    assert (unseen["name"], unseen["x0"], unseen["x1"]) == ("seen by no fit", 3.25, 3.5)
    assert titles(residual) == ["time (s)", "residual (µrad)"]
    assert mirror_view.loop_plot(second, 1, "V")["data"][1]["y"] == [3.0, 4.0]


def test_scores_are_of_three_digits_held_out_before_fitted():
    assert mirror_view.score_rows(fits_of_two()) == [
        ("one", "0.25 %", "0.125 %", "best so far"),
        ("two", "0.75 %", "0.875 %", ""),
    ]
    fits = [LiveFit("a", 0.12345, 12.3456, ()), LiveFit("b", 123.456, 0.0098765, ()), LiveFit("a", 1.0, 12.5, ())]
    assert mirror_view.score_rows(fits, "a") == [
        ("b", "0.00988 %", "123 %", ""),
        ("a", "12.3 %", "0.123 %", ""),
        ("a", "12.5 %", "1 %", "chosen"),
    ]


def test_the_first_channels_of_several_are_drawn_over_the_rows_that_are_shown():
    view = View(900, 250.0, ("one", "two."), (10, 500, 899), ((1.0, 2.0, 3.0), (4.0, 5.0, 6.0)), ((7.0, 8.0, 9.0),) * 1)
    loop, over_time = mirror_view.recording_plot(view, Setting()), mirror_view.time_plot(view, Setting())
    assert (loop["data"][0]["x"], loop["data"][0]["y"]) == ([1.0, 2.0, 3.0], [7.0, 8.0, 9.0])
    assert [(t["x"], t["y"]) for t in over_time["data"]] == [
        ([0.04, 2.0, 3.596], [1.0, 2.0, 3.0]),
        ([0.04, 2.0, 3.596], [7.0, 8.0, 9.0]),
    ]
    assert titles(loop) == ["drive (V)", "output (mrad)"]
    assert mirror_view.about(view) == "900 samples at 250 Hz, 3.6 s."
    assert mirror_view.findings(view) == ["One.", "Two."]


def test_what_an_identification_warns_of_and_could_not_fit_is_told_line_by_line():
    said = {"model": "m", "verdict": ["a", "b"], "warnings": ["c", "d"], "refused": {"e": "f", "g": "h"}}
    model, (first, second, warned, refused) = mirror_view.outcome(json.dumps(said))
    assert (model, first, second) == ("m", "a", "b")
    assert warned.lines == ["Warning: c", "Warning: d"]
    assert refused.lines == ["Not fitted: e: f", "Not fitted: g: h"]


@pytest.mark.parametrize(
    ("state", "progress", "cancelling", "lead", "words"),
    [
        ("queued", None, False, False, "Waiting for another job to end."),
        (
            "cancelled",
            Progress(3, 14, "x"),
            False,
            True,
            "Cancelled; nothing was written. Best so far: two, 0.75 % rms",
        ),
        ("lost", None, False, False, "lost: why"),
        ("running", None, True, False, "Begins, stopping."),
        ("running", Progress(2, 9, "play operators"), False, False, "2 of 9 fits: fitting prandtl_ishlinskii."),
        ("running", Progress(4, 9, "linear part"), False, True, "4 of 9 fits: linear part. Best so far: two, 0.75 %"),
    ],
)
def test_an_identification_says_how_far_it_is_and_what_leads(tmp_path, state, progress, cancelling, lead, words):
    job = Job(1, tmp_path, state, "identification", progress=progress, cancelling=cancelling, words="why")
    said = mirror_view.state_words(job, fits_of_two()[1] if lead else None)
    assert said == (f"{words.partition(' rms')[0]} rms on samples that no fit has seen." if lead else words)


def test_of_an_option_that_is_given_twice_the_last_value_counts(tmp_path):
    words = (
        "identify",
        "--input",
        "2",
        "--name",
        "--input-unit",
        "--input-unit",
        "mV",
        "--rate",
        "5.0",
        "--rate",
        "6.0",
    )
    job = Job(1, tmp_path, "done", arguments=words)
    found = [mirror_view.argument(job, flag, "none") for flag in ("--input", "--input-unit", "--rate", "--output")]
    assert found == ["2", "mV", "6.0", "none"]
    assert mirror_view.argument(Job(1, tmp_path, "done"), "--rate", "none") == "none"


@pytest.mark.parametrize(
    ("name", "unit", "samples", "label"),
    [
        ("angle (urad)", "urad", 7, "3: angle (urad), 7 samples"),
        ("urad", "urad", None, "3: urad (urad)"),
        ("3", "mV", 12, "column 3 (mV), 12 samples"),
        ("4", "", 12, "3: 4, 12 samples"),
        ("", "", None, "column 3"),
    ],
)
def test_a_channel_behind_the_first_is_called_by_its_number_name_and_unit(name, unit, samples, label):
    others = (ChannelInfo("a", "", 1),) * 3
    assert mirror_form.labels(Listing((*others, ChannelInfo(name, unit, samples)), None, ()))[3] == label


def test_what_somebody_has_set_for_a_recording_is_kept_by_its_channels_and_the_oldest_goes():
    form = mirror_form.shown(Form(), IN_MRAD, "a", "a.csv", alone=True)
    about = mirror_form._about(IN_MRAD)
    typed = replace(form.setting, drive=3, output=2, rate="7 kHz", drive_unit="mV", output_unit="mm", name="n")
    found = mirror_form.edited(form, IN_MRAD, typed)
    assert found.chosen == {
        f"{about} drive": "3",
        f"{about} output": "2",
        f"{about} rate": "7 kHz",
        f"{about} 3 drive_unit": "mV",
        "drive_unit": "mV",
        f"{about} 2 output_unit": "mm",
        "output_unit": "mm",
    }
    assert (found.setting, found.seen) == (typed, "a")
    full = replace(form, chosen={str(n): "x" for n in range(200)})
    kept = mirror_form.edited(full, IN_MRAD, replace(form.setting, rate="8 Hz")).chosen
    assert (len(kept), next(iter(kept)), kept[f"{about} rate"]) == (200, "1", "8 Hz")
    back = mirror_form.shown(replace(found, seen="b"), IN_MRAD, "c", "c.csv")
    assert (back.setting, back.seen) == (typed, "c")


@pytest.mark.parametrize(
    ("channels", "rates"),
    [
        ((("u", "V"), ("z", "mrad")), (5.0,)),
        ((("u", "mV"), ("y", "mrad")), (5.0,)),
        ((("u", "V"), ("y", "mrad")), (6.0,)),
    ],
)
def test_files_differ_by_names_units_and_rates_of_their_channels(channels, rates):
    plain = listed(("u", "V"), ("y", "mrad"), rates=(5.0,))
    assert mirror_form._about(plain) == mirror_form._about(listed(("u", "V"), ("y", "mrad"), time=0, rates=(5.0,)))
    assert mirror_form._about(listed(*channels, rates=rates)) != mirror_form._about(plain)


def test_a_displacement_by_its_lever_arm_is_the_arm_in_metres():
    for unit, arm, found in (("um", "37.5 mm", 0.0375), ("mm", " 0.25 m ", 0.25), ("m", "4 um", 4e-6)):
        assert mirror_form.lever_arm_m(Setting(output_unit=unit, lever_arm=arm)) == pytest.approx(found, rel=1e-12)
    for unit in ("mrad", "urad", "rad"):
        assert mirror_form.lever_arm_m(Setting(output_unit=unit, lever_arm="37.5 mm")) is None


def test_a_unit_that_a_second_recording_denies_names_that_recording(tmp_path):
    odd = listed(("drive [mV]", ""), ("angle [mrad]", ""))
    recordings = [
        Dropped("a", "a.csv", tmp_path / "a.csv", "fit", IN_MRAD),
        Dropped("b", "b.csv", tmp_path / "b.csv", "check", odd),
    ]
    with pytest.raises(SettingError) as refusal:
        mirror_form.identification(tmp_path, recordings, Setting(0, 1))
    assert str(refusal.value) == (
        "unit of the drive: the form says V and b.csv says mV; choose what the file says, or set its use to leave out"
    )


def test_several_recordings_are_fitted_and_checked_in_their_order(tmp_path):
    uses = {"d": "check", "a": "fit", "c": "leave", "b": "fit", "e": "check"}
    recordings = [Dropped(name, name, tmp_path / "up" / name, use) for name, use in uses.items()]
    setting = Setting(3, 2, "1.25 kHz", "mV", "urad", "", ("clipping", "drift"), False, True, "  stage y ")
    action = mirror_form.identification(tmp_path, recordings, setting)
    assert action.arguments == (
        *("identify", "up/a", "up/b", "--input", "3", "--output", "2", "--rate", "1250.0"),
        *("--accept", "clipping", "--accept", "drift", "--validate", "up/d", "--validate", "up/e"),
        *("--input-unit", "mV", "--output-unit", "urad", "--name", "stage y", "--mirror-file", "stage y.toml"),
        "--admissible",
    )
    assert (action.title, action.results) == ("identify stage y", ("stage y.toml", "stage y.html"))


# ---------------------------------------------------------------------------------------- what a loop is made to answer
@pytest.fixture
def spans(monkeypatch):
    """What loops are asked for, in place of simulating them: the loop, the span, and from when it is shown."""
    asked = []

    def noted(loop, of, span, from_s):
        asked.append((loop, of, span, from_s))
        return len(asked)

    monkeypatch.setattr(control_model, "_curve", noted)
    monkeypatch.setattr(control_model.parts, "without", lambda loop, *those: replace(loop))
    return asked


@pytest.mark.parametrize(("bandwidth_hz", "samples"), [(400.0, 300), (5000.0, 60), (30.0, 2400), (0.0, 2400)])
def test_a_step_is_shown_for_six_periods_of_the_bandwidth(mission, spans, bandwidth_hz, samples):
    """Within sixty samples and six times 400 periods of the control."""
    scene = scene_of(mission)
    loop = replace(scene.loop, timing=replace(scene.loop.timing, period_s=5e-5))
    control_model._step(loop, "of", control_view.Ask(2e-6, 3e-6, 7.0, 11), bandwidth_hz)
    ((stepped, of, span, from_s),) = spans
    assert stepped.references[0] == Reference(2e-6, 0.0, 1.0)
    assert stepped.references[1:] == loop.references[1:]
    assert (of, span.seed, span.settle_s, from_s) == ("of", 11, 0.0, 0.0)
    assert span.duration_s == pytest.approx(samples * 5e-5, rel=1e-9)


@pytest.mark.parametrize(("freq_hz", "settle_s"), [(0.5, 2.0), (2.5, 0.4), (40.0, 0.4)])
def test_two_periods_of_a_sine_are_shown_behind_one_period_or_what_settles(mission, spans, freq_hz, settle_s):
    loop = scene_of(mission).loop
    control_model._sine(loop, "of", control_view.Ask(2e-6, 3e-6, freq_hz, 12))
    ((sine, of, span, from_s),) = spans
    assert sine.references[0] == replace(loop.references[0], sine_amplitude_rad=3e-6, sine_freq_hz=freq_hz)
    assert sine.references[1:] == loop.references[1:]
    assert (of, span.seed, span.settle_s, from_s) == ("of", 12, settle_s, settle_s)
    assert span.duration_s == pytest.approx(settle_s + 2.0 / freq_hz, rel=1e-12)


def test_each_variant_answers_with_its_own_loop_and_the_jitter_of_the_mission(mission, spans, monkeypatch):
    scene = scene_of(mission)
    table = scene.table.model_copy(update={"duration_s": 3.5, "settle_s": 1.25})
    straight = replace(scene.loop, drive_range_v=(-1.0, 2.0))
    monkeypatch.setattr(control_model, "with_mirror", lambda loop, mirrors, variant: straight)
    monkeypatch.setattr(control_model, "for_mirror", lambda of, loop: (of, loop.drive_range_v))
    asked = control_view.Ask(2e-6, 3e-6, 8.0, 13)
    answers = control_model._fine_answers(replace(scene, table=table), "PI", 50.0, asked, (WITHOUT, WITH))
    assert (answers.step, answers.sine, answers.jitter) == (
        {WITHOUT: 1, WITH: 2},
        {WITHOUT: 3, WITH: 4},
        {WITHOUT: 5, WITH: 6},
    )
    assert [each[1] for each in spans] == [("PI", (-1.0, 2.0)), ("PI", scene.loop.drive_range_v)] * 3
    assert [each[0].drive_range_v for each in spans] == [(-1.0, 2.0), scene.loop.drive_range_v] * 3
    for loop, _, span, from_s in spans[4:]:
        assert loop in (straight, scene.loop)
        assert (span.duration_s, span.settle_s, span.seed, from_s) == (3.5, 1.25, 13, 1.25)


def test_a_run_is_shown_from_where_it_has_settled_with_what_it_had_to_follow(monkeypatch):
    """The angle that is found is what was wanted, and what disturbs, less the error; of the first of two axes."""
    time_s = np.array([0.1, 0.2, 0.3, 0.4])
    run = SimpleNamespace(
        time_s=time_s,
        reference_rad=np.array([[1.0, 21.0], [2.0, 22.0], [4.0, 24.0], [8.0, 28.0]]),
        error_rad=np.array([[0.5, 30.5], [0.25, 30.25], [0.125, 30.125], [0.375, 31.0]]),
        disturbance_rad=np.array([[10.0, 50.0], [20.0, 60.0], [40.0, 70.0], [80.0, 90.0]]),
        drive_v=np.array([[3.0, 4.0], [5.0, 6.0], [7.0, 8.0], [9.0, 10.0]]),
    )
    monkeypatch.setattr(control_model.traces, "trace", lambda *asked: run)
    found = control_model._curve("loop", "of", "span", 0.1 + 0.2)  # a hair above 0.3
    assert found.time_s.tolist() == [0.3, 0.4]
    assert found.wanted_rad.tolist() == [4.0, 8.0]
    assert found.found_rad.tolist() == [4.0 + 40.0 - 0.125, 8.0 + 80.0 - 0.375]
    assert found.error_rad.tolist() == [[0.125, 30.125], [0.375, 31.0]]
    assert found.drive_v.tolist() == [[7.0, 8.0], [9.0, 10.0]]
    assert found.disturbance_rad.tolist() == [[44.0, 94.0], [88.0, 118.0]]


def test_a_tracked_sine_is_shown_in_its_steady_part_alone():
    three = np.arange(8.0).reshape(4, 2)
    run = SimpleNamespace(
        steady=slice(1, 3),
        time_s=np.array([0.0, 0.1, 0.2, 0.3]),
        reference_rad=three,
        output_rad=10.0 + three**2,
        error_rad=100.0 + three,
        drive_v=200.0 + three,
    )
    found = control_model._tracked(run)
    assert (found.time_s.tolist(), found.wanted_rad.tolist()) == ([0.1, 0.2], [2.0, 4.0])
    assert (found.found_rad.tolist(), found.disturbance_rad) == ([14.0, 26.0], None)
    assert found.error_rad.tolist() == [[102.0, 103.0], [104.0, 105.0]]
    assert found.drive_v.tolist() == [[202.0, 203.0], [204.0, 205.0]]


@pytest.mark.parametrize("name", [PID, PID_INVERSE])
def test_the_loop_of_control_follows_a_step_and_the_end_of_a_sine(monkeypatch, name):
    asked = []
    monkeypatch.setattr(control_model.simulate, "track", lambda *given: asked.append(given) or given)
    monkeypatch.setattr(control_model, "_tracked", lambda given: given[1])
    monkeypatch.setattr(control_model.control, "inverse", lambda plant: ("inverse", plant))
    monkeypatch.setattr(control_model.control, "no_feedforward", lambda plant: ("none", plant))
    setup = SimpleNamespace(timing=SimpleNamespace(period_s=1e-3))
    plants = {WITH: "given", WITHOUT: "straight"}
    answers = control_model._pid_answers(name, plants, setup, 20.0, control_view.Ask(2e-6, 3e-6, 8.0), (WITH, WITHOUT))
    assert answers.step == answers.sine == plants
    assert answers.jitter == {}
    kind = "inverse" if name == PID_INVERSE else "none"
    assert [each[:4] for each in asked] == [(name, p, setup, (kind, p)) for p in plants.values()] * 2
    step, sine = asked[1][4:], asked[3][4:]
    assert (step[0].shape, np.unique(step[0]).tolist(), step[1]) == ((300, 1), [2e-6], slice(0, 300))
    assert np.max(sine[0]) == pytest.approx(3e-6, rel=1e-3)
    assert (sine[1].stop, sine[1].stop - sine[1].start) == (sine[0].shape[0], 250)


def test_the_least_and_the_longest_step_of_the_loop_of_control(monkeypatch):
    asked = []
    monkeypatch.setattr(control_model.simulate, "track", lambda *given: asked.append(given[4].shape[0]))
    monkeypatch.setattr(control_model, "_tracked", lambda given: given)
    monkeypatch.setattr(control_model.control, "no_feedforward", lambda plant: None)
    setup = SimpleNamespace(timing=SimpleNamespace(period_s=1e-2))
    for crossover_hz in (0.25, 2.5, 40.0):
        ask = control_view.Ask(2e-6, 3e-6, 8.0)
        control_model._pid_answers(PID, {WITH: "given"}, setup, crossover_hz, ask, (WITH,))
    assert asked[::2] == [600, 240, 60]


def test_a_tuned_controller_has_everything_of_its_scene(monkeypatch):
    tuned = SimpleNamespace(
        controller="tuned",
        margins=SimpleNamespace(bandwidth_hz=123.0),
        values={"a": 2.5, "b": 31.25},
        residual_rms_rad=4e-7,
        bound_by=("one", "two"),
    )
    asked = {}
    for name, made in (("plants", ["plant", "other"]), ("tune", tuned), ("build", "built")):
        monkeypatch.setattr(controller_study, name, lambda *given, n=name, m=made: asked.update({n: given}) or m)
    units = [SimpleNamespace(name="a", unit="Hz"), SimpleNamespace(name="b", unit="")]
    other, mine = (SimpleNamespace(name=n, parameters=lambda plant, u=u: u) for n, u in (("PI", []), ("mine", units)))
    monkeypatch.setattr(control_model, "families", lambda table: [other, mine])
    monkeypatch.setattr(control_model, "_responses", lambda loop, of, freq: (freq + 1.0, freq + 2.0))
    loop = SimpleNamespace(
        timing=SimpleNamespace(period_s=2e-4),
        drive=SimpleNamespace(minimum_v=-6.0, maximum_v=7.0),
        drive_range_v=(-3.0, 4.0),
        optical=SimpleNamespace(field_of_view_rad=1.5e-3),
    )
    scene = SimpleNamespace(table=SimpleNamespace(seed=9, modulus_margin=0.45), loop=loop)
    found = control_model._fine(scene, "mine")
    assert asked == {
        "plants": (scene, 9),
        "tune": ("mine", scene.table, ["plant", "other"]),
        "build": ("mine", scene, "tuned"),
    }
    assert (found.name, found.margins, found.tuned) == ("mine", tuned.margins, "a 2.5 Hz, b 31.2")
    assert (found.residual_rad, found.bound_by, found.asked_modulus) == (4e-7, ("one", "two"), 0.45)
    assert (found.field_of_view_rad, found.rate_hz) == (1.5e-3, pytest.approx(5000.0))
    assert (found.freq_hz.size, found.freq_hz[[0, -1]].tolist()) == (500, pytest.approx([0.25, 2497.5]))
    assert (found.loop_gain[0], found.sensitivity[0]) == (pytest.approx(1.25), pytest.approx(2.25))
    assert found.ask.args == (scene, "built", 123.0)


def test_the_loop_of_control_is_shown_with_its_own_limits_and_rate(mission):
    found = control_model.controller(mission, PID)
    cases = cases_of(mission.mission)
    assert found.limits_v == (cases.setup.drive.minimum_v, cases.setup.drive.maximum_v)
    assert found.identified_v == cases.mirrors.drive_range_v
    assert found.rate_hz == pytest.approx(1.0 / cases.setup.timing.period_s)
    assert found.freq_hz[[0, -1]] == pytest.approx([0.5e-5 * found.rate_hz, 0.4995 * found.rate_hz])
    assert (found.tuned, found.bound_by) == ("the gains of [control]", ())
    assert math.isnan(found.residual_rad) and math.isnan(found.asked_modulus)
    at = np.interp(found.margins.crossover_hz, found.freq_hz, found.loop_gain)
    assert at == pytest.approx(1.0, rel=1e-2)
    assert np.max(found.sensitivity) == pytest.approx(1.0 / found.margins.modulus, rel=1e-2)


def test_a_controller_is_tuned_anew_once_a_file_that_the_mission_names_is_another(tmp_path, monkeypatch):
    text = SHIPPED.read_text("utf-8").replace('spectrum = "olympus"', 'spectrum = "table"\nfile = "shake.csv"', 1)
    (tmp_path / "m.toml").write_text(text, "utf-8")
    read = []
    monkeypatch.setattr(control_model, "_kept", {})
    monkeypatch.setattr(control_model, "_controller", lambda file, name: read.append(file.contents[0].content) or name)
    contents = (b"Hz, urad^2/Hz\n0.1, 100\n1000, 0.1\n", b"Hz, urad^2/Hz\n0.1, 100\n1000, 0.2\n")
    for content in (contents[0], *contents):
        (tmp_path / "shake.csv").write_bytes(content)
        control_model.controller(load_mission(tmp_path / "m.toml"), "PI")
    assert read == [*contents]


def drawn_of_the_bench():
    """Every figure of the pages of mirror and control by its name, from numbers that are all unlike."""
    values = {"sensitivity": np.array([0.25, 1.5, 1.0]), "loop_gain": np.array([40.0, 2.0, 1e-5])}
    of, setting = made(limits_v=(-6.0, 7.0), identified_v=(-3.0, 4.0), **values), Setting(0, 1, "", "mV", "urad")
    both = {WITH: two_axes(), WITHOUT: two_axes(0.5)}
    answers, (fit, _) = control_view.Answers(both, both, both), fits_of_two()
    view = View(900, 250.0, (), (10, 500, 899), ((1.0, 2.0, 3.0),), ((7.0, 8.0, 9.0),))
    return {
        "sensitivity": control_view.sensitivity_plot(of),
        "gain": control_view.gain_plot(of),
        **{name: getattr(control_view, f"{name}_plot")(answers) for name in ("step", "sine", "jitter", "motion")},
        "drive": control_view.drive_plot(of, both),
        "loop": mirror_view.loop_plot(fit, 1, "mV"),
        "residual": mirror_view.residual_plot(fit, 1),
        "recording": mirror_view.recording_plot(view, setting),
        "time": mirror_view.time_plot(view, setting),
    }


DRAWN = {
    "sensitivity": """
height 316, 237 of it rows
xaxis: frequency (Hz) log 0 to 2 grid
yaxis: |S|, error over disturbance log -0.6021 to 0.29 grid
scatter |S| (keyed): #D55E00 1.73 solid x=1,10,100 y=0.25,1.5,1
line 1 / modulus margin asked for (0.5) (keyed): #000000 1.73 dash x0=0 x1=1 y0=2 y1=2 above
line None: #777777 1.33 dot x0=0 x1=1 y0=1 y1=1 above
line bandwidth 20 Hz (keyed): #009E73 1.73 dashdot x0=20 x1=20 y0=0 y1=1 above
""",
    "gain": """
height 331, 252 of it rows
xaxis: frequency (Hz) log 0 to 2 grid
yaxis: |L|, loop gain log -4 to 1.716 grid
scatter |L| (keyed): #0072B2 1.73 solid x=1,10,100 y=40,2,1e-05
line None: #777777 1.33 dot x0=0 x1=1 y0=1 y1=1 above
line crossover 30 Hz (keyed): #009E73 1.73 dashdot x0=30 x1=30 y0=0 y1=1 above
""",
    "step": """
height 316, 237 of it rows
xaxis: time (ms) linear -0.2 to 4.2 grid
yaxis: line of sight, axis x (µrad) linear 0.7 to 7.3 grid
scatter wanted (keyed): #777777 1.73 dot x=0,1,4 y=1,2,3
scatter with hysteresis (keyed): #D55E00 1.73 solid x=0,1,4 y=4,5,7
scatter without hysteresis (keyed): #0072B2 1.73 dash x=0,1,4 y=4,5,7
""",
    "sine": """
height 331, 252 of it rows
xaxis: time (ms) linear -0.2 to 4.2 grid
yaxis: error, axis x (µrad) linear 10.9 to 13.1 grid
scatter with hysteresis (keyed): #D55E00 1.73 solid x=0,1,4 y=11,12,13
scatter without hysteresis (keyed): #0072B2 1.73 dash x=0,1,4 y=11,12,13
""",
    "jitter": """
height 331, 252 of it rows
xaxis: time (s) linear 0.2373 to 0.5167 grid
yaxis: error, axis x (µrad) linear 10.9 to 13.1 grid
scatter with hysteresis (keyed): #D55E00 0.93 solid x=0.25,0.251,0.254 y=11,12,13
scatter without hysteresis (keyed): #0072B2 0.93 dash x=0.5,0.501,0.504 y=11,12,13
""",
    "motion": """
height 316, 237 of it rows
xaxis: time (s) linear 0.2373 to 0.5167 grid
yaxis: angle, axis x (µrad) linear 2.5 to 35.5 grid
scatter to be followed (keyed): #777777 4 solid x=0.25,0.251,0.254 y=31,32,34
scatter with hysteresis (keyed): #D55E00 1.73 solid x=0.25,0.251,0.254 y=4,5,7
scatter without hysteresis (keyed): #0072B2 1.73 dash x=0.5,0.501,0.504 y=4,5,7
""",
    "drive": """
height 301, 222 of it rows
xaxis: time (ms) linear -0.2 to 4.2 grid
yaxis: drive from the bias (V) linear -6.65 to 7.65 grid
scatter with hysteresis (keyed): #D55E00 1.73 solid x=0,1,4 y=0.5,0.6,0.7
scatter without hysteresis (keyed): #0072B2 1.73 dash x=0,1,4 y=0.5,0.6,0.7
line range of the identification (keyed): #777777 1.73 dot x0=0 x1=1 y0=-3 y1=-3 above
line range of the identification: #777777 1.73 dot x0=0 x1=1 y0=4 y1=4 above
line amplifier's limits (keyed): #000000 1.73 dash x0=0 x1=1 y0=-6 y1=-6 above
line amplifier's limits: #000000 1.73 dash x0=0 x1=1 y0=7 y1=7 above
""",
    "loop": """
height 331, 252 of it rows
xaxis: drive (mV) linear 6.95 to 8.05 grid
yaxis: angle (µrad) linear 8.85 to 12.15 grid
scatter measured (keyed): #777777 4 solid x=7,8 y=9,10
scatter one (keyed): #D55E00 1.73 dash x=7,8 y=11,12
""",
    "residual": """
height 331, 252 of it rows
xaxis: time (s) linear 2.45 to 3.55 grid
yaxis: residual (µrad) linear -15.35 to 14.35 grid
scatter measured less model (keyed): #0072B2 1.73 solid x=2.5,3.5 y=13,-14
rect seen by no fit (keyed): 0 rgba(86,180,233,0.2) x0=3.25 x1=3.5 y0=0 y1=1 below
""",
    "recording": """
height 345, 266 of it rows
xaxis: drive (mV) linear 0.9 to 3.1 grid
yaxis: output (µrad) linear 6.9 to 9.1 grid
scatter measured (keyed): #0072B2 3.33 circle x=1,2,3 y=7,8,9
""",
    "time": """
height 338, 289 of it rows
xaxis: linear -0.1378 to 3.774 grid
yaxis: drive (mV) linear 0.9 to 3.1 grid
xaxis2: time (s) linear -0.1378 to 3.774 grid
yaxis2: output (µrad) linear 6.9 to 9.1 grid
scatter drive: #000000 1.73 solid x=0.04,2,3.596 y=1,2,3
scatter output: #0072B2 1.73 solid x=0.04,2,3.596 y=7,8,9
""",
}


@pytest.mark.parametrize("name", DRAWN)
def test_a_figure_of_the_bench_is_drawn_with_its_axes_colours_dashes_and_key(name):
    assert plot_lines(drawn_of_the_bench()[name]) == DRAWN[name].strip().splitlines()


# ------------------------------------------------------------------------------------------------------- word for word
DRIVES = "u drive input command voltage in ch0 v my_volts overdrive_2 U Ch0 set.command"
OUTPUTS = "y output out angle tilt sensor displacement position angles disp_1 Tilt_x OUT the-sensor"
NEITHER = "mu inner ch01 via commands yes outer tilted sensors tension"


@pytest.mark.parametrize("name", [*DRIVES.split(), *OUTPUTS.split(), *NEITHER.split()])
def test_a_channel_is_guessed_by_each_word_for_one_and_not_by_a_word_within_another(name):
    found = mirror_form.first_setting(listed(("a", ""), ("b", ""), (name, "")), "x.csv")
    guessed = (2, 0) if name in DRIVES.split() else (0, 2) if name in OUTPUTS.split() else (0, 1)
    assert (found.drive, found.output) == guessed


@pytest.mark.parametrize("unit", mirror_form.OUTPUT_UNITS)
@pytest.mark.parametrize("stated", ["{}", "µ{}"], ids=["plain", "micro"])
def test_each_unit_of_an_output_is_taken_from_the_file(unit, stated):
    said = stated.format(unit[1:]) if unit[0] == "u" and stated != "{}" else unit
    for listing in (listed(("a", "V"), ("b", said)), listed(("a", "V"), (f"b [{said}]", ""))):
        found = mirror_form.first_setting(listing, "x.csv")
        assert (found.drive, found.output, found.drive_unit, found.output_unit) == (0, 1, "V", unit)


@pytest.mark.parametrize(
    ("what", "words"),
    [
        ("play operators", "fitting prandtl_ishlinskii"),
        ("Bouc-Wen starts", "fitting bouc_wen, start by start"),
        ("linear part", "linear part"),
    ],
)
def test_each_phase_of_an_identification_has_its_words(tmp_path, what, words):
    job = Job(1, tmp_path, "running", progress=Progress(3, 7, what))
    assert mirror_view.doing(what) == words
    assert mirror_view.state_words(job, None) == f"3 of 7 fits: {words}."
    assert mirror_view.state_words(replace(job, cancelling=True), None) == f"3 of 7 fits: {words}, stopping."


@pytest.mark.parametrize(
    ("state", "words"),
    [
        ("queued", "Waiting for another job to end."),
        ("running", "Begins."),
        ("done", "Done."),
        ("cancelled", "Cancelled; nothing was written."),
        ("failed", "failed: why."),
        ("lost", "lost: why."),
        ("unreadable", "unreadable: why."),
    ],
)
def test_each_state_of_an_identification_has_its_words(tmp_path, state, words):
    job, lead = Job(1, tmp_path, state, words="why."), "Chosen" if state == "done" else "Best so far"
    told = f"{words} {lead}: bouc_wen, 0.0123 % rms on samples that no fit has seen."
    assert mirror_view.state_words(job, None) == words
    assert mirror_view.state_words(job, LiveFit("bouc_wen", 9.87654, 0.01234, ())) == told


OUTSIDE = "is outside 100 mHz to 10 kHz; type one between"
ASKED = {
    ("9 urad", "0.1 rad", "0.1 Hz"): control_view.Ask(9e-6, 0.1, 0.1),
    (" 1 nrad ", " 2 mrad", "3 kHz "): control_view.Ask(1e-9, 2e-3, 3000.0),
    ("0.5 nrad", "x", "y"): "step: 0.5 nrad is outside 1 nrad to 100 mrad; type one between",
    ("-1 urad", "x", "y"): "step: -1 urad is outside 1 nrad to 100 mrad; type one between",
    ("1 urad", "0.2 rad", "y"): "amplitude of the sine: 0.2 rad is outside 1 nrad to 100 mrad; type one between",
    ("1 urad", "2 urad", "0.05 Hz"): f"frequency of the sine: 0.05 Hz {OUTSIDE}",
    ("1 urad", "2 urad", "12 kHz"): f"frequency of the sine: 12 kHz {OUTSIDE}",
    ("1 urad", "2 urad", "4 kHz"): "frequency of the sine: 4 kHz is not below 4 kHz, half the rate of the loop, 8 kHz, "
    "which would take it for a slower one; type one below",
}


@pytest.mark.parametrize("typed", ASKED)
def test_what_is_asked_of_a_loop_is_taken_or_refused_by_its_field(typed):
    if isinstance(ASKED[typed], control_view.Ask):
        assert control_view.ask_of(*typed, 8000.0) == ASKED[typed]
        return
    with pytest.raises(control_view.AskError) as refusal:
        control_view.ask_of(*typed, 8000.0)
    assert str(refusal.value) == ASKED[typed]


@pytest.mark.parametrize(
    ("text", "after"),
    [
        ('mirror.file = "a.toml"\nname = "x"\n[b]\n', 'mirror.file = "s.toml"\nname = "x"\n[b]\n'),
        ('name = "x"\nmirror = { file = "a" }\n[b]\n', 'name = "x"\nmirror.file = "s.toml"\n[b]\n'),
        (
            'mirror.name = "a"\n# kept\nx = 1\nmirror.play.a = [\n1]\n[b]\nmirror.c = 1\n[mirror.linear]\ny = 1\n',
            'mirror.file = "s.toml"\n# kept\nx = 1\n[b]\nmirror.c = 1\n',
        ),
        ('\ufeffmirror.file = "a"\r\nx = 1', '\ufeffmirror.file = "s.toml"\r\nx = 1'),
    ],
)
def test_a_mirror_in_keys_above_all_tables_makes_room_for_a_file(tmp_path, text, after):
    draft = with_mirror_file(Draft(text, tmp_path / "m.toml", ()), tmp_path / "s.toml")
    assert draft.text == after
    assert tomllib.loads(after.removeprefix("\ufeff"))["mirror"] == {"file": "s.toml"}
    assert with_mirror_file(draft, tmp_path / "s.toml").text == after


def test_a_recording_says_its_rate_with_all_its_digits_and_gives_the_mirror_the_beginning_of_its_name():
    found = mirror_form.first_setting(listed(("u", "V"), ("y", "rad"), rates=(12207.03125,)), f"{'n' * 150}.tar.csv")
    assert (found.rate, found.name) == ("12207.03125 Hz", f"{'n' * 100}-mirror")
    assert mirror_form.first_setting(listed(("u", "V")), "dir.d/run.2.csv").name == "run.2-mirror"


def test_of_a_mirror_and_its_report_that_are_there_the_mirror_is_named(tmp_path):
    recordings = [Dropped("k", "a.csv", tmp_path / "a.csv")]
    said = []
    for name in ("both.html", "both.toml", "v1.2.html"):
        (tmp_path / name).touch()
        with pytest.raises(SettingError) as refusal:
            mirror_form.identification(tmp_path, recordings, Setting(0, 1, name=f" {name.rpartition('.')[0]} "))
        said.append(str(refusal.value))
    ends = "is there already and is left as it is; type another name"
    assert said == [f"name of the mirror: {name} {ends}" for name in ("both.html", "both.toml", "v1.2.html")]


NOT_DISTURBED = "Nothing disturbs this loop, or nothing was asked."
NO_ANSWERS = control_view.Answers({}, {}, {})


@pytest.mark.parametrize(
    ("draw", "words"),
    [
        (mirror_view.nothing, "Drop a recording to see it here."),
        (lambda: control_view.sensitivity_plot(SimpleNamespace(sensitivity=None)), "No response by frequency."),
        (lambda: control_view.gain_plot(SimpleNamespace(loop_gain=None)), "No response by frequency."),
        (lambda: control_view.drive_plot(SimpleNamespace(), {}), NOT_DISTURBED),
        (lambda: control_view.step_plot(NO_ANSWERS), NOT_DISTURBED),
        (lambda: control_view.sine_plot(NO_ANSWERS), NOT_DISTURBED),
        (lambda: control_view.jitter_plot(NO_ANSWERS), NOT_DISTURBED),
        (lambda: control_view.motion_plot(NO_ANSWERS), NOT_DISTURBED),
    ],
)
def test_a_plot_of_the_bench_without_anything_to_show_says_why(draw, words):
    made = draw()
    assert (made["data"], [each["text"] for each in made["layout"]["annotations"]]) == ([], [words])


def test_a_loop_of_a_mirror_of_several_axes_is_told_where_it_is_designed(monkeypatch):
    monkeypatch.setattr(control_model.mirror, "of", lambda mission: None)
    file = SimpleNamespace(mission=SimpleNamespace(fine_pointing=SimpleNamespace(mirror_file="two.toml")))
    with pytest.raises(ValueError, match="names a mirror") as refusal:
        control_model._controller(file, "PI")
    assert str(refusal.value) == (
        "fine_pointing.mirror_file names a mirror of several axes, and this page designs for one: microrad design has "
        "its controllers, and a run of the mission simulates them"
    )
    assert (PID, PID_INVERSE) == ("PID of [control]", "PID of [control] + inverse")


@pytest.mark.parametrize(
    ("arm", "words"),
    [
        (
            " ",
            "the output is a length (mm) and a mirror needs an angle; type the distance from the axis of rotation to "
            'the point measured, such as "50 mm"',
        ),
        ("-5 um", "-5 um is not above 0; type a length such as 50 mm"),
    ],
)
def test_a_lever_arm_that_is_none_is_refused_with_what_to_type(arm, words):
    with pytest.raises(SettingError) as refusal:
        mirror_form.lever_arm_m(Setting(output_unit="mm", lever_arm=arm))
    assert str(refusal.value) == f"lever arm: {words}"


def test_a_controller_that_is_not_tuned_yet_has_a_row_that_says_why_beside_those_that_are(monkeypatch):
    monkeypatch.setattr(control_model, "design_cells", lambda *of: ("to its margins", *map(str, of), *[""] * 5))
    made = SimpleNamespace(residual_rad=1.2345e-6, tuned="a", margins="b", bound_by="c")
    _, table, _ = control_model.blocks({"PI": "being tuned", "LQG": made})
    assert list(table.headings)[:3] == ["controller", "residual of an axis,\nrms in theory (µrad)", "tuned to"]
    assert [list(map(str, row)) for row in table.rows] == [
        ["PI", "", "being tuned", "", "", ""],
        ["LQG", "1.23", "to its margins", "a", "b", "c"],
    ]
    untold = next(each for each in control_model.blocks({"PI": "being tuned"}) if isinstance(each, Table))
    assert (list(untold.headings), untold.rows) == (["controller", "tuned to"], [["PI", "being tuned"]])


@pytest.mark.parametrize(
    "said",
    [
        *("", "{", "[]", "7", "null", '"text"', "[" * 100_000, "{}"),
        '{"warnings": [], "refused": [], "model": "m", "verdict": []}',
        '{"warnings": [], "refused": null, "model": "m", "verdict": []}',
        '{"warnings": 3, "refused": {}, "model": "m", "verdict": []}',
        '{"warnings": [], "refused": {}, "model": "m"}',
        '{"warnings": [], "refused": {}, "verdict": []}',
        '{"warnings": [], "refused": {}, "model": "m", "verdict": null}',
    ],
)
def test_what_is_no_outcome_of_an_identification_is_none(said):
    assert mirror_view.outcome(said) is None


@pytest.mark.parametrize("place", [0, 1])
@pytest.mark.parametrize("typed", ["0.99 nrad", "0 urad", "-5 urad", "101 mrad", "1 rad"])
def test_step_and_amplitude_each_have_both_their_bounds(place, typed):
    given = ["1 urad", "1 urad", "1 Hz"]
    given[place] = typed
    name = ("step", "amplitude of the sine")[place]
    with pytest.raises(control_view.AskError) as refusal:
        control_view.ask_of(*given, 30e3)
    assert str(refusal.value) == f"{name}: {typed} is outside 1 nrad to 100 mrad; type one between"
