"""`microrad pointing`: errors in time windows, by source, as text and as data."""

import io
import json
import math
from contextlib import redirect_stdout
from types import SimpleNamespace

import numpy as np
import pytest

import several_axes
from link_files import FADING
from microrad import cli
from microrad.cli import coupled_design
from microrad.cli import pointing as cli_pointing
from microrad.cli.coupled_design import reach_share_percent
from microrad.cli.windows import indices_of_mission
from microrad.loop import controller_study, coupled_study
from microrad.loop.controller_study import Outlook
from microrad.loop.disturbance import olympus
from microrad.loop.disturbance.windows import ErrorIndex, windowed_rms
from microrad.mission.file import load_mission
from microrad.report.fine_pointing import worst_case
from places import ROOT
from shipped import DEFAULT, without_fine_pointing


@pytest.fixture(scope="module")
def document():
    """The data of the shipped mission, with a mean over a second and its drift over a minute."""
    words = ["pointing", str(DEFAULT), "--window", "1 s", "--spacing", "1 min", "--json"]
    with redirect_stdout(io.StringIO()) as printed, pytest.raises(SystemExit) as stop:
        cli.app(args=words, prog_name="microrad")
    assert not stop.value.code
    return json.loads(printed.getvalue())


@pytest.mark.promise("pointing-34")
@pytest.mark.promise("pointing-33")
def test_sources_add_up_to_all_and_the_mean_and_the_rest_to_the_whole(document):
    whole, mean, left, drift = document["indices"]
    assert [each["index"] for each in document["indices"]] == ["APE", "MPE", "RPE", "PDE"]
    for each in document["indices"]:
        for part in ("left_rad", "without_the_loop_rad"):
            *sources, total = each[part].values()
            assert total == pytest.approx(math.hypot(*sources), rel=1e-12, abs=0.0)
    for part in ("left_rad", "without_the_loop_rad"):
        assert mean[part]["all"] ** 2 + left[part]["all"] ** 2 == pytest.approx(
            whole[part]["all"] ** 2, rel=1e-12, abs=0.0
        )
        assert drift[part]["all"] == pytest.approx(
            math.sqrt(2.0) * mean[part]["all"], rel=0.02, abs=0.0
        )  # a minute is long
    assert whole["left_rad"]["all"] < 0.02 * whole["without_the_loop_rad"]["all"]


@pytest.mark.promise("pointing-34")
def test_without_the_loop_the_vibration_is_olympus_in_both_axes(document):
    _, mean, _, drift = document["indices"]
    second = math.sqrt(2.0) * windowed_rms(olympus(), ErrorIndex("MPE", 1.0))
    assert mean["without_the_loop_rad"]["OLYMPUS"] == pytest.approx(second, rel=1e-9, abs=0.0)
    assert mean["without_the_loop_rational_rad"] > 1.003 * mean["without_the_loop_rad"]["all"]
    assert drift["without_the_loop_rational_rad"] is None and (drift["window_s"], drift["spacing_s"]) == (1.0, 60.0)


@pytest.mark.promise("readme-5")
@pytest.mark.promise("pointing-33", "pointing-34")
@pytest.mark.promise("readme-23")
def test_the_tables_name_sources_windows_and_what_filters_make_of_them(call, document):
    code, out, _ = call("pointing", DEFAULT)
    assert code == 0
    assert "Left by the loop under PI\n" in out and "Without the loop, by linear filters" in out
    for words in ("vibration", "(OLYMPUS)", "gauge noise", "MPE 1 s ", "RPE 10 ms "):
        assert words in out
    assert max(map(len, out.splitlines())) <= 80
    options = ("--window", "1 ms", "--spacing", "1 min", "--controller", "LQG", "--json")
    found = json.loads(call("pointing", DEFAULT, *options).out)
    assert found["controller"] == "LQG"
    assert found["indices"][0]["left_rad"]["all"] < document["indices"][0]["left_rad"]["all"]  # that of PI
    assert [(each["index"], each["window_s"], each["spacing_s"]) for each in found["indices"]] == [
        ("APE", None, None),
        ("MPE", 0.001, None),
        ("RPE", 0.001, None),
        ("PDE", 0.001, 60.0),
    ]


@pytest.mark.promise("pointing-38")
@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--window", "1 us"), "window_s of MPE is 1e-06 s, and the sensor reads every 0.0002 s: give more"),
        (("--window", "0 s"), "window_s of MPE is 0 s; give a finite number above zero"),
        (("--simulate", "0"), "0 runs leave no errors: ask for 1 run or more, 2 for an interval"),
        (("--simulate", "2", "--window", "2 s"), "MPE looks at 2 s of a run, and 1.5 s are left behind its settling"),
        (("--simulate", "2", "--window", "0.2 ms"), "MPE over 200 µs looks at one control sample of a run: give a"),
        (("--controller", "best"), "'best' is no controller of this mission; it has PI"),
    ],
)
def test_what_cannot_be_is_refused(refused, options, words):
    assert words in refused("pointing", DEFAULT, *options)


@pytest.mark.promise("pointing-37")
def test_runs_stand_beside_linear_theory_in_the_same_windows(call):
    """The printed hysteresis of the shipped mission adds more than all sensor noise: it shows in every index."""
    options = ("--window", "10 ms", "--spacing", "0.1 s", "--simulate", "16", "--json")
    code, out, _ = call("pointing", DEFAULT, *options)
    document = json.loads(out)
    found = document["simulated"]["indices"]
    assert (code, document["simulated"]["runs"]) == (0, 16)
    for each, linear in zip(found, document["indices"], strict=True):
        times = [(one["index"], one["window_s"], one["spacing_s"]) for one in (each, linear)]
        assert times[0] == times[1]
        assert each["linear_rad"] == pytest.approx(linear["left_rad"]["all"], rel=0.01, abs=0.0)
        assert each["simulated_rad"] > each["linear_rad"] + each["interval_rad"] > each["linear_rad"]
        assert each["simulated_rad"] == pytest.approx(math.hypot(*each["simulated_by_axis_rad"]), rel=1e-12, abs=0.0)
    _, out, _ = call("pointing", DEFAULT, *options[:-2], "1")
    assert "Simulated, with hysteresis\n" in out and "Number of runs: 1;" in " ".join(out.split())
    rows = [line.split() for line in out[out.index("Simulated, with") :].splitlines() if line.split()[:1] == ["APE"]]
    assert [row[-1] for row in rows] == ["unknown"]
    assert max(map(len, out.splitlines())) <= 80


NAMED = """
[error_budget]
with_loop = true

[error_budget.requirements.code_word]
index = "RPE"
window = "10 ms"
confidence = 0.9973
interpretation = "temporal"
axes = "radial"
limit = "5 urad"

[error_budget.requirements.handover]
index = "PDE"
window = "0.1 s"
spacing = "5 min"
observation = "10 min"
confidence = 0.95
interpretation = "temporal"
axes = "x"
limit = "5 urad"
"""


@pytest.mark.promise("pointing-33", "pointing-38")
def test_windows_are_those_that_the_requirements_name_and_runs_leave_out_what_does_not_fit(call, tmp_path):
    mission = tmp_path / "m.toml"
    mission.write_text(DEFAULT.read_text("utf-8") + NAMED, "utf-8")
    code, out, _ = call("pointing", mission, "--simulate", "2", "--json")
    found = json.loads(out)

    def times(part):
        return [(each["index"], each["window_s"], each["spacing_s"]) for each in part["indices"]]

    assert code == 0
    assert times(found) == [("APE", None, None), ("RPE", 0.01, None), ("PDE", 0.1, 300.0)]
    assert times(found["simulated"]) == times(found)[:2]
    assert found["simulated"]["left_out"] == ["PDE 100 ms 300 s apart"]
    code, out, _ = call("pointing", mission, "--simulate", "2")
    said = " ".join(out.split())
    assert (code, said.count("Longer than a run behind its settling, and left out: PDE 100 ms 300 s apart.")) == (0, 1)
    span = load_mission(mission).mission.fine_pointing
    room_s = span.duration_s - span.settle_s
    long = NAMED.replace('spacing = "5 min"', f'spacing = "{room_s - 0.05:g} s"')  # 50 ms too much with the window
    mission.write_text(DEFAULT.read_text("utf-8") + long, "utf-8")
    code, out, _ = call("pointing", mission, "--simulate", "2", "--json")
    assert (code, json.loads(out)["simulated"]["left_out"]) == (0, [f"PDE 100 ms {room_s - 0.05:.3g} s apart"])
    code, out, _ = call("pointing", mission, "--window", "1 s", "--json")
    assert times(json.loads(out)) == [("APE", None, None), ("MPE", 1.0, None), ("RPE", 1.0, None)]


@pytest.fixture
def coded(tmp_path):
    """Writes the shipped mission with a code word of some length, and a margin that pointing misses at times."""

    def write(word, margin="5.5 dB"):
        text = DEFAULT.read_text("utf-8")
        for old, new in (
            ('[requirement]\nmargin = "3 dB"', f'[requirement]\nmargin = "{margin}"'),
            ("[communication]\n", f'[communication]\ncode_word = "{word}"\n'),
        ):
            assert text.count(old) == 1
            text = text.replace(old, new)
        (tmp_path / "m.toml").write_text(text, "utf-8")
        return tmp_path / "m.toml"

    return write


@pytest.mark.promise("link-4")
@pytest.mark.promise("pointing-39")
@pytest.mark.endurance
def test_a_code_word_averages_over_fades_that_are_shorter(call, coded):
    shares = []
    for word in ("0.4 ms", "50 ms"):
        code, out, _ = call("pointing", coded(word), "--window", "10 ms", "--simulate", "16", "--json")
        found = json.loads(out)["simulated"]["code_words"]
        assert code == 0
        for each in (found["lost"], found["time"]):
            assert 0.0 <= each["low"] <= each["value"] <= each["high"] <= 1.0
        shares.append((found["lost"]["value"], found["time"]["value"]))
        assert found["words"] == 16 * round(1.5 / found["code_word_s"])
    assert shares[0][1] == shares[1][1] > 0.02
    assert shares[1][0] < 0.5 * shares[0][0] < shares[0][1]
    _, out, _ = call("pointing", coded("10 ms"), "--window", "10 ms", "--simulate", "2")
    assert "Lost to pointing, simulated" in out and "code words of 10 ms" in out and "Of 300 code words" in out
    _, out, _ = call("pointing", DEFAULT, "--window", "10 ms", "--simulate", "1", "--json")
    assert "code_words" not in json.loads(out)["simulated"]


@pytest.mark.promise("pointing-110")
def test_a_code_of_the_mission_has_its_error_ratio_under_the_simulated_errors(call, tmp_path):
    table = FADING.replace('series = "fades.csv"\nunit = "linear"\nnormalised = "mean"\nsampling = "100 us"\n', "")
    (tmp_path / "m.toml").write_text(DEFAULT.read_text("utf-8") + table, "utf-8")
    code, out, _ = call("pointing", tmp_path / "m.toml", "--window", "10 ms", "--simulate", "2", "--json")
    found = json.loads(out)["simulated"]["coded"]
    assert (code, found["code"], found["target"], found["span_s"]) == (0, "ccsds-k7-1-2", 1e-6, 5e-3)
    assert 0.0 <= found["ratio"]["low"] <= found["ratio"]["value"] <= found["ratio"]["high"] < 0.5
    assert 0.0 < found["penalty_db"] < 10.0
    table = table.replace('"5 ms"', '"5 s"')
    (tmp_path / "m.toml").write_text(DEFAULT.read_text("utf-8") + table, "utf-8")
    code, _, told = call("pointing", tmp_path / "m.toml", "--window", "10 ms", "--simulate", "2")
    assert code == 2
    assert "the interleaver spans 5 s, longer than a run, of which 1.5 s are left" in " ".join(told.split())


@pytest.mark.promise("pointing-38", "pointing-41", "pointing-42")
@pytest.mark.endurance
def test_the_shipped_mission_leaves_in_its_runs_what_the_page_says(call, coded):
    """Of 64 runs: rms with their intervals, and code words of three lengths; numbers of a simulated loop, to 2 %."""
    options = ("--window", "10 ms", "--simulate", "64", "--json")
    lost, time = [], []
    for word in ("1 ms", "10 ms", "50 ms"):
        _, out, _ = call("pointing", coded(word), *options)
        found = json.loads(out)
        document = found["simulated"]
        lost.append(document["code_words"]["lost"])
        time.append(document["code_words"]["time"]["value"])
    assert [each["value"] for each in lost] == pytest.approx([0.114, 0.0288, 0.0005], rel=0.02, abs=6e-5)
    assert (lost[1]["low"], lost[1]["high"]) == pytest.approx((0.0245, 0.0334), rel=0.02)
    assert time == pytest.approx([0.14] * 3, abs=0.005)
    apart = [
        each["linear_rad"] / of_all_steps["left_rad"]["all"] - 1.0
        for each, of_all_steps in zip(document["indices"], found["indices"], strict=True)
    ]
    assert max(map(abs, apart)) == pytest.approx(0.004, rel=0.2)
    whole, mean, _ = document["indices"]
    for each, figures in ((whole, (1.94, 0.012, 1.34)), (mean, (0.494, 0.007, 0.375))):
        found = [1e6 * each[key] for key in ("simulated_rad", "interval_rad", "linear_rad")]
        assert found == pytest.approx(figures, rel=0.02, abs=5e-4)


def test_words_at_the_largest_data_rate_have_what_is_left_of_its_margin(call, coded):
    """Solved for 10 urad, so that less than the margin is left beyond that: the loop hardly ever is."""
    path = coded("10 ms", "3 dB")
    text = path.read_text("utf-8").replace('data_rate = "300 Mbit/s"', 'data_rate = "largest"', 1)
    path.write_text(text, "utf-8")
    code, out, _ = call("pointing", path, "--window", "10 ms", "--simulate", "2", "--json")
    assert code == 0 and json.loads(out)["simulated"]["code_words"]["lost"]["value"] == 0.0


def test_runs_of_a_mission_without_a_loop_are_refused(refused, tmp_path):
    (tmp_path / "m.toml").write_text(without_fine_pointing(DEFAULT.read_text("utf-8")), "utf-8")
    assert "has no table [fine_pointing]: microrad init writes one" in refused("pointing", "m.toml", "--simulate", "2")


@pytest.mark.promise("pointing-40")
@pytest.mark.parametrize(
    ("word", "words"),
    [
        ("2 s", "a code word of 2 s is longer than a run, of which 1.5 s are left behind its settling: make the runs"),
        ("0.1 ms", "a code word of 100 µs has less than two control samples, 200 µs apart"),
        ("0 s", "communication.code_word"),
    ],
)
def test_a_code_word_that_no_run_holds_is_refused(refused, coded, word, words):
    coded(word)
    assert words in refused("pointing", "m.toml", "--window", "10 ms", "--simulate", "2")


def test_a_time_without_a_unit_is_refused_by_its_option(call):
    code, out, err = call("pointing", DEFAULT, "--window", "1")
    assert (code, out) == (2, "") and "'--window': \"1\" is a number without a unit" in err


def test_a_mirror_of_several_axes_has_windows_that_its_design_and_its_runs_agree_with(call, tmp_path, monkeypatch):
    monkeypatch.setattr(coupled_study.designs, "names", lambda table: ("PI",))  # the one that is asked for
    (tmp_path / "two-axes.toml").write_text(several_axes.TEXT, encoding="utf-8")
    named = several_axes.mission_text(("[fine_pointing]\n", '[fine_pointing]\nmirror_file = "two-axes.toml"\n'))
    (tmp_path / "m.toml").write_text(named, encoding="utf-8")
    options = ("--window", "10 ms", "--simulate", "16", "--json")
    code, out, _ = call("pointing", tmp_path / "m.toml", *options)
    document = json.loads(out)
    whole, mean, left = (each["left_rad"]["all"] for each in document["indices"])
    assert (code, math.hypot(mean, left)) == (0, pytest.approx(whole, rel=1e-9, abs=0.0))
    _, out, _ = call("design", tmp_path / "m.toml", "--json")
    (designed,) = [each for each in json.loads(out)["controllers"] if each["name"] == "PI"]
    assert whole == pytest.approx(math.hypot(*designed["residual_rms_rad"]), rel=1e-6, abs=0.0)
    for each, linear in zip(document["simulated"]["indices"], (whole, mean, left), strict=True):
        assert each["linear_rad"] == pytest.approx(linear, rel=0.01, abs=0.0)
        assert each["simulated_rad"] == pytest.approx(
            linear, abs=2.0 * each["interval_rad"], rel=0.0
        )  # little hysteresis
        assert each["interval_rad"] < 0.15 * linear


@pytest.mark.parametrize("name", ["PI", "LQG"])
def test_the_controller_that_is_asked_for_is_the_one_that_is_designed(tmp_path, monkeypatch, name):
    (tmp_path / "two-axes.toml").write_text(several_axes.TEXT, encoding="utf-8")
    named = several_axes.mission_text(("[fine_pointing]\n", '[fine_pointing]\nmirror_file = "two-axes.toml"\n'))
    (tmp_path / "m.toml").write_text(named, encoding="utf-8")

    def design(scene, progress, names):
        return SimpleNamespace(made=[SimpleNamespace(controller=each) for each in names])

    monkeypatch.setattr(coupled_study, "design", design)
    assert cli_pointing._designed(load_mission(tmp_path / "m.toml"), name)[1] == name


@pytest.mark.parametrize(("still", "reach", "percent"), [(2.0, (-50.0, 50.0), 10.0), (2.0, (-20.0, 50.0), 25.0)])
def test_the_share_of_a_drive_is_with_three_times_its_rms_of_the_nearer_end(still, reach, percent):
    assert reach_share_percent(still, 1.0, reach) == pytest.approx(percent)


IDENTIFIED = ROOT / "tests" / "corpus" / "0.2.0" / "mirrors" / "identified.toml"


@pytest.mark.promise("readme-5")
@pytest.mark.promise("pointing-63", "pointing-72")
@pytest.mark.promise("readme-23")
def test_the_worst_case_of_an_identified_mirror_is_printed_and_verified_in_time(call):
    code, out, _ = call("worst-case", DEFAULT, "--mirror", IDENTIFIED, "--window", "10 ms", "--json")
    found = json.loads(out)
    assert code == 0 and found["controller"] == "PI"
    assert (found["corners"], found["unstable_draws"], found["unstable_corners"]) == (64, 0, 0)
    assert [each["index"] for each in found["errors"]] == ["APE", "MPE", "RPE"]
    for each in found["errors"]:
        drawn, worst = each["drawn_rad"], each["largest_rad"]
        assert drawn["median"] <= drawn["worse"] <= worst["value"] and each["nominal_rad"] <= worst["value"]
    assert found["smallest_modulus"]["value"] <= found["drawn_modulus"]["worse"] <= found["nominal_modulus"]
    names = [each["parameter"] for each in found["most_sensitive"]]
    assert names[0] == "bouc_wen.d1" and {*names} == {*found["smallest_modulus"]["sigmas"]}
    assert found["verified_in_time"]["agrees"] and found["verified_in_time"]["linear"] == "settles"


@pytest.mark.promise("pointing-72")
def test_a_worst_case_needs_a_mirror_of_which_something_is_known(refused):
    words = refused("worst-case", DEFAULT)
    assert (
        "has no table uncertainty, so nothing can be drawn; `microrad identify` writes one into its mirror file"
        in words
    )


@pytest.mark.promise("pointing-72")
@pytest.mark.parametrize(("draws", "corners", "code"), [(0, 0, 0), (1, 0, 1), (0, 1, 1)])
def test_an_unstable_draw_or_corner_alone_ends_the_worst_case_with_1(call, monkeypatch, draws, corners, code):
    found = SimpleNamespace(unstable_draws=draws, unstable_corners=corners)
    monkeypatch.setattr(controller_study, "design", lambda scene, progress, names: ("made",))
    monkeypatch.setattr("microrad.loop.worst_case.of_scene", lambda scene, known, made: "subject")
    monkeypatch.setattr("microrad.loop.worst_case.worst_case", lambda *args, **options: found)
    monkeypatch.setattr(worst_case, "worst_case_data", lambda found: {})
    assert call("worst-case", DEFAULT, "--mirror", IDENTIFIED, "--window", "10 ms", "--json").code == code


def test_a_spacing_goes_before_the_windows_that_requirements_name(monkeypatch):
    named = SimpleNamespace(index=ErrorIndex("RPE", 0.02))
    monkeypatch.setattr("microrad.link.error_budget.assembly.requirement_of", lambda table: named)
    table = SimpleNamespace(with_loop=True, requirements={"data": None})
    assert [each.window_s for each in indices_of_mission(table, [], [])] == [None, 0.02]
    assert [each.window_s for each in indices_of_mission(table, [3.0], [])] == [None, 3.0, 3.0]
    found = indices_of_mission(table, [], [2.0])
    assert [(each.kind, each.window_s, each.spacing_s) for each in found if each.kind == "PDE"] == [
        ("PDE", 0.01, 2.0),
        ("PDE", 1.0, 2.0),
    ]


DEFAULT_WINDOWS = [("APE", None), ("MPE", 0.01), ("RPE", 0.01), ("MPE", 1.0), ("RPE", 1.0)]


@pytest.mark.parametrize(
    ("with_loop", "stated", "found"),
    [
        (True, [("RPE", 0.5), ("APE", None), ("MPE", 2.0), ("RPE", 0.5)], [("APE", None), ("RPE", 0.5), ("MPE", 2.0)]),
        (True, [("APE", None)], DEFAULT_WINDOWS),
        (True, [("RKE", 0.5), ("MPE", 2.0)], [("APE", None), ("MPE", 2.0)]),
        (False, [("RPE", 0.5)], DEFAULT_WINDOWS),
    ],
)
def test_windows_are_those_of_the_requirements_on_the_loop_each_once(monkeypatch, with_loop, stated, found):
    monkeypatch.setattr(
        "microrad.link.error_budget.assembly.requirement_of", lambda each: SimpleNamespace(index=ErrorIndex(*each))
    )
    table = SimpleNamespace(with_loop=with_loop, requirements=dict(enumerate(stated)))
    assert [(each.kind, each.window_s) for each in indices_of_mission(table, [], [])] == found
    assert [(each.kind, each.window_s) for each in indices_of_mission(None, [], [])] == DEFAULT_WINDOWS


def test_an_index_whose_times_just_fit_into_a_run_is_simulated():
    scene = SimpleNamespace(table=SimpleNamespace(duration_s=2.0, settle_s=0.5))
    fits = [ErrorIndex("APE"), ErrorIndex("MPE", 1.5), ErrorIndex("PDE", 0.5, 1.0)]
    too_long = [ErrorIndex("MPE", 1.75), ErrorIndex("PDE", 0.5, 1.25)]
    assert cli_pointing._fitting(scene, [*fits, *too_long]) == (fits, too_long)


@pytest.mark.parametrize(
    ("given", "windows", "spacings"),
    [((), [], []), (("--window", "2 s"), [2.0], []), (("--spacing", "1 min"), [], [60.0])],
)
def test_times_that_are_given_are_not_left_out_of_the_runs(call, monkeypatch, given, windows, spacings):
    """Without any, the indices that fit are simulated; with some, all of them, which is refused where one is long."""
    asked, ran = [], []

    def indices(table, *times):
        asked.append((table, *times))
        return ["index"]

    def simulated(loop, scene, made, indices, runs):
        ran.append((indices, runs))
        return (), None, None

    monkeypatch.setattr(cli_pointing, "indices_of_mission", indices)
    monkeypatch.setattr(cli_pointing, "stated_beside", lambda mission, sources, indices: None)
    monkeypatch.setattr(
        cli_pointing, "_designed", lambda mission, name: (SimpleNamespace(theory=None, loop=None), None)
    )
    monkeypatch.setattr(cli_pointing, "_fitting", lambda scene, indices: (["fits"], ["left out"]))
    monkeypatch.setattr(cli_pointing, "_simulated", simulated)
    monkeypatch.setattr("microrad.loop.pointing_loop.linear.close", lambda theory, made: None)
    monkeypatch.setattr("microrad.loop.pointing_loop.windows.windowed_errors", lambda closed, indices: None)
    monkeypatch.setattr("microrad.report.fine_pointing.words.arrival", lambda loop: "")
    monkeypatch.setattr("microrad.report.fine_pointing.data.arrival", lambda scene: {})
    monkeypatch.setattr("microrad.report.fine_pointing.windows.windows_data", lambda errors: [])
    monkeypatch.setattr(
        "microrad.report.fine_pointing.simulated_windows.simulated_view", lambda *found: SimpleNamespace(blocks=())
    )
    monkeypatch.setattr(
        "microrad.report.fine_pointing.simulated_windows.simulated_data",
        lambda errors, lost, runs, left_out, coded: {"left_out": left_out},
    )
    result = call("pointing", DEFAULT, *given, "--simulate", "3", "--json")
    assert (result.code, asked[0][1:]) == (0, (windows, spacings))
    assert ran == [(["index"] if given else ["fits"], 3)]
    assert json.loads(result.out)["simulated"] == {"left_out": [] if given else ["left out"]}


# ------------------------------------------------------------------------------------------------ promises of a design
HELD, BROKEN = Outlook(1e-6, 1.5e-6), Outlook(1e-6, 1.75e-6)


@pytest.mark.parametrize(
    ("figures", "accept", "marks", "code"),
    [
        ((HELD, HELD), (), ["", ""], 0),
        ((HELD, BROKEN), (), ["", "refused"], 1),
        ((HELD, BROKEN), ("--accept",), ["", "accepted"], 0),
    ],
)
@pytest.mark.parametrize("axes", [1, 2])
def test_a_design_that_the_mirror_does_not_bear_out_is_refused_unless_it_is_accepted(
    call, monkeypatch, tmp_path, axes, figures, accept, marks, code
):
    made = (SimpleNamespace(name="PI"), SimpleNamespace(name="LQG"))
    several = [SimpleNamespace(worst=each, holds=each.holds) for each in figures]
    refused = {"Youla": "no Youla here"} if axes == 2 else {}
    found = SimpleNamespace(made=made, refused=refused)
    file, module = DEFAULT, coupled_design if axes == 2 else cli_pointing
    if axes == 2:
        (tmp_path / "two-axes.toml").write_text(several_axes.TEXT, encoding="utf-8")
        named = several_axes.mission_text(("[fine_pointing]\n", '[fine_pointing]\nmirror_file = "two-axes.toml"\n'))
        file = tmp_path / "m.toml"
        file.write_text(named, encoding="utf-8")
    monkeypatch.setattr(coupled_study, "design_and_promise", lambda scene, progress: (found, several))
    monkeypatch.setattr(controller_study, "design_and_promise", lambda *args: list(zip(made, figures, strict=True)))
    monkeypatch.setattr(module, "_data", lambda design, left, mark: {"name": design.name, "mark": mark})
    result = call("design", file, "--json", *accept)
    data = json.loads(result.out)
    assert (result.code, [each["mark"] for each in data["controllers"]]) == (code, marks)
    broken = [said for said in data["warnings"] if "as linear theory says" in said]
    assert bool(broken) == (BROKEN in figures) and set(refused.values()) <= set(data["warnings"])
    for said in broken:
        assert said.startswith("more than 1.5 times as much as") and "by LQG (1.75 times): " in said
        assert ("accepted as they are" in said, "--accept" in said) == (bool(accept), not accept)


def made(gain_up=2.0, margin=None, **more):
    """A design of one axis, as far as it is printed."""
    margins = SimpleNamespace(
        **{"modulus": 0.5, "gain_up": gain_up, "phase_rad": 0.5 * math.pi, "delay_s": 1e-3, "crossover_hz": 90.0},
        **{"bandwidth_hz": 120.0, "disk": 0.4},
    )
    matrices = SimpleNamespace(**{each: np.full((1, 1), k) for k, each in enumerate("ABCD")})
    controller = SimpleNamespace(system=matrices, anti_windup=np.full((1, 1), 9.0), **more)
    tuned = SimpleNamespace(values={"gain": 3.0}, margins=margins, bound_by=("modulus margin",))
    return SimpleNamespace(name="PI", inverse=False, tuned=tuned, margin=margin, controller=controller)


@pytest.mark.parametrize(("gain_up", "db", "words"), [(math.inf, None, "none"), (10.0, 20.0, "20.0 dB")])
def test_a_gain_that_may_rise_without_end_is_none_in_the_data_and_in_the_text(monkeypatch, gain_up, db, words):
    design, left = made(gain_up), Outlook(1e-6, 1.75e-6)
    data = cli_pointing._data(design, left, "refused")
    assert data["margins"]["gain_up_db"] == (None if db is None else pytest.approx(db))
    assert data["margins"]["phase_deg"] == pytest.approx(90.0)
    assert (data["residual_rms_rad_per_axis"], data["simulated_rms_rad_per_axis"]) == (1e-6, 1.75e-6)
    assert data["matrices"] == {"A": [[0]], "B": [[1]], "C": [[2]], "D": [[3]], "anti_windup": [[9.0]]}
    assert "tuned_for_modulus_margin" not in data
    assert cli_pointing._data(made(margin=0.7), left, "")["tuned_for_modulus_margin"] == 0.7
    monkeypatch.setattr(cli_pointing, "tuned_text", lambda scene, values, margin: f"{values} {margin}")
    scene = SimpleNamespace(loop=SimpleNamespace(timing=SimpleNamespace(period_s=2e-4)))
    told = cli_pointing._text(scene, (design,), (left,), ["refused"], ["mind the step"])
    row = next(line for line in told.splitlines() if line.split()[:2] == ["PI", "1.000"])
    assert row.split() == ["PI", "1.000", "1.750", "refused", "0.500", "90°", *words.split(), "120", "Hz"]
    assert "One axis at 5 kHz" in told and "Warning: mind the step." in told


def test_a_larger_margin_and_drives_of_hysteresis_are_data_of_a_design_of_several_axes_where_it_has_them():
    left = SimpleNamespace(axes=(Outlook(1e-6, 2e-6), Outlook(3e-6, 4e-6)))
    for margin, forward in ((None, None), (0.7, SimpleNamespace(drives=np.full((1, 2), 5.0)))):
        margins = SimpleNamespace(modulus=0.5, disk=SimpleNamespace(disk=0.4, freq_hz=80.0), bandwidth_hz=120.0)
        one = made(margin=margin, forward=forward)
        design = SimpleNamespace(
            name="PI",
            tuned=(("gain", 3.0), ("corner_hz", 40.0)),
            margin=margin,
            margins=margins,
            controller=one.controller,
            drive_v=np.ones(2),
        )
        data = coupled_design._data(design, left, "mark")
        assert data["tuned"] == {"gain": 3.0, "corner_hz": 40.0}
        assert (data["residual_rms_rad"], data["simulated_rms_rad"]) == ([1e-6, 3e-6], [2e-6, 4e-6])
        assert data.get("tuned_for_modulus_margin") == margin
        assert data["matrices"].get("drives_of_hysteresis") == (None if forward is None else [[5.0, 5.0]])
        assert (data["margins"]["disk"], data["margins"]["disk_hz"]) == (0.4, 80.0)


@pytest.mark.parametrize(
    ("given", "times"),
    [
        ((), [("APE", None, None)]),
        (
            ("--window", "10 ms", "--spacing", "1 min", "--spacing", "2 min"),
            [
                ("APE", None, None),
                ("MPE", 0.01, None),
                ("RPE", 0.01, None),
                ("PDE", 0.01, 60.0),
                ("PDE", 0.01, 120.0),
            ],
        ),
    ],
)
@pytest.mark.parametrize("axes", [1, 2])
def test_a_worst_case_is_of_the_windows_that_are_given_and_of_the_mirror_of_its_kind(
    call, monkeypatch, tmp_path, given, times, axes
):
    asked = []

    def searched(subject, seed, indices, on_progress):
        asked.append((subject, seed, [(each.kind, each.window_s, each.spacing_s) for each in indices]))
        return SimpleNamespace(unstable_draws=0, unstable_corners=0)

    def design(scene, progress, names):
        made = [f"{each} of {axes}" for each in names]
        return SimpleNamespace(made=made) if axes == 2 else made

    for room, scene_of, of in (
        (controller_study, "of_scene", "of_table"),
        (coupled_study, "of_coupled_scene", "of_several_axes"),
    ):
        seeded = SimpleNamespace(table=SimpleNamespace(seed=7))
        monkeypatch.setattr(room, "scene", lambda *args, seeded=seeded: seeded)
        monkeypatch.setattr(room, "design", design)
        monkeypatch.setattr(f"microrad.loop.worst_case.{of}", lambda *args, of=of: of)
        monkeypatch.setattr(f"microrad.loop.worst_case.{scene_of}", lambda scene, known, made: (known, made))
    monkeypatch.setattr("microrad.loop.worst_case.worst_case", searched)
    monkeypatch.setattr(worst_case, "worst_case_text", lambda found, width: f"a text of {width} columns")
    (tmp_path / "two-axes.toml").write_text(several_axes.TEXT, encoding="utf-8")
    mirror = ("--mirror", tmp_path / "two-axes.toml") if axes == 2 else ()
    result = call("worst-case", DEFAULT, *mirror, "--controller", "LQG", *given)
    assert (result.code, result.out) == (0, "a text of 80 columns\n")
    known = "of_several_axes" if axes == 2 else "of_table"
    assert asked == [((known, f"LQG of {axes}"), 7, times)]


# -------------------------------------------------------------------------------------- several designs, axes and times
def test_designs_of_several_axes_are_told_with_both_axes_and_the_drives_of_the_best(monkeypatch):
    monkeypatch.setattr(coupled_design, "tuned_text", lambda scene, values, margin: f"{values} {margin}")
    left = [
        SimpleNamespace(axes=(Outlook(1e-6, 2e-6), Outlook(3e-6, 4e-6)), simulated_rad=4.5e-6),
        SimpleNamespace(axes=(Outlook(1.25e-6, 1.5e-6), Outlook(2.5e-6, 3.5e-6)), simulated_rad=3.8e-6),
    ]
    margins = [
        SimpleNamespace(modulus=0.5, disk=SimpleNamespace(disk=0.4), bandwidth_hz=123.0),
        SimpleNamespace(modulus=0.625, disk=SimpleNamespace(disk=0.25), bandwidth_hz=4567.0),
    ]
    drives = [np.array([0.1, 0.2, 0.3]), np.array([0.5, 0.25, 0.125])]
    made = [
        SimpleNamespace(name=name, margins=m, tuned=f"tuned {name}", margin=None, drive_v=v)
        for name, m, v in zip(("PI", "LQG"), margins, drives, strict=True)
    ]
    mirror = SimpleNamespace(
        mirror=SimpleNamespace(name="tripod", actuators=3, axes=4),
        actuators=[SimpleNamespace(name=f"P{n}") for n in (1, 2, 3)],
    )
    scene = SimpleNamespace(
        mirror=mirror, table=SimpleNamespace(rate_hz=6250.0), static_v=(1.0, 2.0, 0.5), reach_v=(-5.0, 7.0)
    )
    found = SimpleNamespace(made=made)
    text = coupled_design._text(scene, found, left, ["refused", ""], ["mind the step"])
    said = " ".join(text.split())
    assert "tripod: 3 actuators and 4 outputs, line of sight of 2 axes at 6.25 kHz." in said
    rows = [line.split() for line in text.splitlines()]
    assert ["PI", *["1.000", "/", "3.000", "2.000", "/", "4.000", "refused", "0.500", "0.400"]] in rows
    assert ["LQG", *["1.250", "/", "2.500", "1.500", "/", "3.500", "0.625", "0.250"]] in rows
    assert ["PI", "123", "Hz"] in rows and ["LQG", "4.57", "kHz"] in rows
    assert ["LQG", "tuned", "LQG", "None"] in rows
    assert "actuator under LQG" in said and "with 3 rms of 5 V" in said
    assert ["P1", "1", "0.5", "50", "%"] in rows  # of (1 + 3 · 0.5) V
    assert ["P2", "2", "0.25", "55", "%"] in rows
    assert ["P3", "0.5", "0.125", "17.5", "%"] in rows
    assert said.endswith("Warning: mind the step.")


@pytest.mark.parametrize(
    ("named", "accept", "words"),
    [
        ([], False, ""),
        ([], True, ""),
        (
            ["PI (1.75 times)", "LQG (2.00 times)"],
            True,
            "more than 1.5 times as much as linear theory says is left, simulated on the mission's mirror, by PI (1.75 "
            "times), LQG (2.00 times): accepted as they are",
        ),
        (
            ["PI (1.75 times)"],
            False,
            "more than 1.5 times as much as linear theory says is left, simulated on the mission's mirror, by PI (1.75 "
            "times): refused, here and by microrad export; choose by the simulated figure, or take these with --accept",
        ),
    ],
)
def test_designs_that_do_not_keep_their_promise_are_all_named(named, accept, words):
    assert coupled_design.broken_promises(named, accept) == words


def test_two_designs_of_one_axis_are_told_row_by_row(monkeypatch):
    monkeypatch.setattr(cli_pointing, "tuned_text", lambda scene, values, margin: f"{values['gain']:g} {margin}")
    one, two = made(10.0), made(math.inf, margin=0.7)
    two = SimpleNamespace(**{**vars(two), "name": "LQG"})
    two.tuned = SimpleNamespace(values={"gain": 4.5}, margins=SimpleNamespace(**vars(two.tuned.margins)), bound_by=())
    two.tuned.margins.modulus, two.tuned.margins.bandwidth_hz, two.tuned.margins.phase_rad = 0.75, 4567.0, 1.0
    scene = SimpleNamespace(loop=SimpleNamespace(timing=SimpleNamespace(period_s=1.6e-4)))
    figures = Outlook(1.25e-6, 1.5e-6), Outlook(2.5e-6, 7.5e-6)
    text = cli_pointing._text(scene, (one, two), figures, ["", "refused"], [])
    rows = [line.split() for line in text.splitlines()]
    assert "One axis at 6.25 kHz" in text and "Warning" not in text
    assert ["PI", "1.250", "1.500", "0.500", "90°", "20.0", "dB", "120", "Hz"] in rows
    assert ["LQG", "2.500", "7.500", "refused", "0.750", "57°", "none", "4.57", "kHz"] in rows
    assert ["PI", "3", "None"] in rows and ["LQG", "4.5", "0.7"] in rows
    data = cli_pointing._data(two, figures[1], "refused")
    assert (data["name"], data["bound_by"], data["mark"], data["inverse"]) == ("LQG", [], "refused", False)
    assert {key: data["margins"][key] for key in ("modulus", "delay_s", "disk", "crossover_hz", "bandwidth_hz")} == {
        "modulus": 0.75,
        "delay_s": 1e-3,
        "disk": 0.4,
        "crossover_hz": 90.0,
        "bandwidth_hz": 4567.0,
    }


def test_each_window_is_asked_for_with_each_spacing():
    found = indices_of_mission(None, [0.25, 3.0], [60.0, 7.5])
    assert [(each.kind, each.window_s, each.spacing_s) for each in found] == [
        ("APE", None, None),
        ("MPE", 0.25, None),
        ("RPE", 0.25, None),
        ("PDE", 0.25, 60.0),
        ("PDE", 0.25, 7.5),
        ("MPE", 3.0, None),
        ("RPE", 3.0, None),
        ("PDE", 3.0, 60.0),
        ("PDE", 3.0, 7.5),
    ]


@pytest.mark.parametrize("word", [None, 2e-6])
@pytest.mark.parametrize("fading", [None, "a series"])
def test_runs_answer_for_words_and_for_a_code_where_the_mission_asks_for_them(monkeypatch, word, fading):
    from microrad.link.pointing import code_words, coded_residual
    from microrad.loop.controller_study import results
    from microrad.loop.pointing_loop import simulated_windows

    asked = []

    def ask(questions, loop, made, span, runs, on_progress):
        asked.append((questions, loop, made, span, runs))
        return [f"answer to {each}" for each in questions]

    monkeypatch.setattr(results, "span", lambda table: "span")
    monkeypatch.setattr(simulated_windows, "windows_asked", lambda *given: "windows")
    monkeypatch.setattr(simulated_windows, "ask", ask)
    monkeypatch.setattr(code_words.FadeMargin, "of", lambda data: "margin")
    monkeypatch.setattr(code_words, "words_asked", lambda margin, word, loop, span: f"words of {word}")
    monkeypatch.setattr(coded_residual.CodedBeam, "of", lambda data: "beam")
    monkeypatch.setattr(coded_residual, "coded_asked", lambda beam, loop, span: "code")
    monkeypatch.setattr("microrad.link.of", lambda mission: mission)
    monkeypatch.setattr("microrad.link.study.solve_rate", lambda mission: mission)
    table = SimpleNamespace(code_word_s=word, fading=fading)
    mission = SimpleNamespace(mission=SimpleNamespace(communication=table), path="m.toml")
    scene = SimpleNamespace(loop="loop", table="table", theory="theory")
    found = cli_pointing._simulated(mission, scene, "made", ["index"], 5)
    assert found == (
        "answer to windows",
        None if word is None else "answer to words of 2e-06",
        None if fading is None else "answer to code",
    )
    (((first, *others), *rest),) = asked
    assert (first, rest) == ("windows", ["loop", "made", "span", 5])
    assert others == ["words of 2e-06"] * (word is not None) + ["code"] * (fading is not None)


def test_a_spacing_without_windows_is_refused(refused):
    words = refused("worst-case", DEFAULT, "--mirror", IDENTIFIED, "--spacing", "1 min")
    assert "--spacing is between windows: give --window, their length, too." in words


# ------------------------------------------------------------------------- what cannot be computed names its mission
def cannot(*given, **more):
    raise ValueError("it cannot be")


@pytest.mark.parametrize(
    ("options", "part"),
    [
        ((), "microrad.cli.pointing.indices_of_mission"),
        ((), "microrad.cli.pointing.stated_beside"),
        ((), "microrad.loop.coupled_study.of_mission"),
        ((), "microrad.loop.controller_study.design"),
        ((), "microrad.loop.pointing_loop.linear.close"),
        ((), "microrad.loop.pointing_loop.windows.windowed_errors"),
        ((), "microrad.link.error_budget.assembly.judge"),
        (("--simulate", "2"), "microrad.loop.pointing_loop.simulated_windows.windows_asked"),
        (("--simulate", "2"), "microrad.loop.pointing_loop.simulated_windows.ask"),
    ],
)
def test_each_step_of_the_errors_that_cannot_be_is_refused_with_the_mission(refused, monkeypatch, options, part):
    class Scene(controller_study.Scene):
        loop, table, theory = "loop", "table", "theory"

    made, scene = SimpleNamespace(controller="made"), object.__new__(Scene)
    answers = {
        "microrad.cli.pointing.indices_of_mission": ["index"],
        "microrad.cli.pointing.stated_beside": SimpleNamespace(with_loop=True),
        "microrad.cli.pointing._fitting": (["index"], []),
        "microrad.loop.coupled_study.of_mission": scene,
        "microrad.loop.controller_study.design": (made,),
        "microrad.loop.controller_study.results.span": "span",
        "microrad.loop.pointing_loop.linear.close": "closed",
        "microrad.loop.pointing_loop.windows.windowed_errors": "errors",
        "microrad.loop.pointing_loop.simulated_windows.windows_asked": "windows",
        "microrad.loop.pointing_loop.simulated_windows.ask": ["answer"],
        "microrad.link.error_budget.assembly.judge": SimpleNamespace(judged=()),
        "microrad.report.fine_pointing.words.arrival": "",
        "microrad.report.fine_pointing.data.arrival": {},
        "microrad.report.fine_pointing.windows.windows_data": {},
        "microrad.report.fine_pointing.windows.windows_text": "",
    }
    for name, answer in answers.items():
        monkeypatch.setattr(name, cannot if name == part else lambda *given, answer=answer, **more: answer)
    assert refused("pointing", DEFAULT, *options) == f"microrad: {DEFAULT}: it cannot be\n"


@pytest.mark.parametrize(
    ("axes", "command", "part"),
    [
        (1, "design", "microrad.loop.controller_study.scene"),
        (1, "design", "microrad.loop.controller_study.offered"),
        (1, "design", "microrad.loop.controller_study.design_and_promise"),
        (2, "design", "microrad.loop.coupled_study.scene"),
        (2, "design", "microrad.loop.coupled_study.design_and_promise"),
        (1, "worst-case", "microrad.loop.worst_case.of_table"),
        (1, "worst-case", "microrad.loop.controller_study.design"),
        (1, "worst-case", "microrad.loop.worst_case.worst_case"),
        (2, "worst-case", "microrad.loop.worst_case.of_several_axes"),
        (2, "worst-case", "microrad.loop.coupled_study.design"),
    ],
)
def test_a_design_or_a_search_that_cannot_be_is_refused_with_the_mission(
    refused, folder, monkeypatch, axes, command, part
):
    (folder / "two-axes.toml").write_text(several_axes.TEXT, encoding="utf-8")
    mirror = ("--mirror", "two-axes.toml") if axes == 2 else ()
    monkeypatch.setattr("microrad.loop.worst_case.of_table", lambda *given: "known")
    monkeypatch.setattr("microrad.loop.worst_case.of_several_axes", lambda *given: "known")
    monkeypatch.setattr("microrad.loop.worst_case.of_scene", lambda *given: "subject")
    for room in (controller_study, coupled_study):
        monkeypatch.setattr(room, "scene", lambda *given: SimpleNamespace(table=SimpleNamespace(seed=7)))
    monkeypatch.setattr(controller_study, "offered", lambda *given: ("PI",))
    monkeypatch.setattr(controller_study, "design", lambda *given: ("made",))
    monkeypatch.setattr(part, cannot)
    said = refused(command, DEFAULT, *mirror)
    assert said == f"microrad: {DEFAULT}: it cannot be\n"


@pytest.mark.parametrize("as_json", [False, True])
def test_warnings_of_several_axes_are_broken_promises_then_what_is_left_out_then_what_is_refused(
    call, folder, monkeypatch, as_json
):
    (folder / "two-axes.toml").write_text(several_axes.TEXT, encoding="utf-8")
    made = [SimpleNamespace(name=name) for name in ("PI", "LQG", "H2")]
    left = [SimpleNamespace(worst=each, holds=each.holds, times=9.0) for each in (BROKEN, HELD, Outlook(1e-6, 2e-6))]
    found = SimpleNamespace(made=made, refused={"Youla": "no Youla here", "Glover": "no Glover here"})
    told = []
    monkeypatch.setattr(coupled_study, "scene", lambda *given: "scene")
    monkeypatch.setattr(coupled_study, "design_and_promise", lambda scene, progress: (found, left))
    monkeypatch.setattr("microrad.report.fine_pointing.words.left_out", lambda scene: ["no drift", "no creep"])
    monkeypatch.setattr(coupled_design, "_data", lambda design, left, mark: {"name": design.name, "mark": mark})
    monkeypatch.setattr(coupled_design, "_text", lambda *given: told.append(given) or "in words")
    result = call("design", DEFAULT, "--mirror", "two-axes.toml", *["--json"] * as_json)
    if as_json:
        data = json.loads(result.out)
        assert [*data] == ["mission_sha256", "mirror", "controllers", "warnings"]
        assert (data["mission_sha256"], data["mirror"]) == (
            load_mission(DEFAULT).sha256,
            several_axes.two_axes().mirror.name,
        )
        assert [tuple(each.values()) for each in data["controllers"]] == [
            ("PI", "refused"),
            ("LQG", ""),
            ("H2", "refused"),
        ]
        broken, *others = data["warnings"]
    else:
        ((scene, designs, figures, marks, (broken, *others)),) = told
        assert (scene, designs, figures, marks) == ("scene", found, left, ["refused", "", "refused"])
        assert result.out == "in words\n"
    assert (
        result.code == 1
        and " is left, simulated on the mission's mirror, by PI (1.75 times), H2 (2.00 times): " in broken
    )
    assert others == ["no drift", "no creep", "no Youla here", "no Glover here"]


@pytest.mark.parametrize(
    ("holds", "code"), [((True, None), 0), ((), 0), ((True, False, None), 1), ((False, True), 1), ((None,), 0)]
)
@pytest.mark.parametrize("as_json", [False, True])
def test_windows_runs_and_budget_stand_behind_each_other_and_a_limit_that_is_not_kept_is_exit_1(
    call, monkeypatch, holds, code, as_json
):
    asked = []
    judged = SimpleNamespace(judged=[SimpleNamespace(total=SimpleNamespace(holds=each)) for each in holds])
    scene = SimpleNamespace(theory="theory", loop="loop")
    wide = "microrad.report"
    parts = {
        "microrad.cli.pointing.indices_of_mission": lambda table, windows, spacings: ["short", "long"],
        "microrad.cli.pointing.stated_beside": lambda mission, listed, indices: (
            asked.append((str(listed), indices)) or SimpleNamespace(with_loop=True)
        ),
        "microrad.cli.pointing._designed": lambda mission, name: asked.append(name) or (scene, f"made {name}"),
        "microrad.cli.pointing._fitting": lambda scene, indices: (indices[:1], indices[1:]),
        "microrad.cli.pointing._simulated": lambda mission, scene, made, indices, runs: (
            asked.append((made, indices, runs)) or ("errors of runs", "lost", "coded")
        ),
        "microrad.loop.pointing_loop.linear.close": lambda theory, made: f"{theory} with {made}",
        "microrad.loop.pointing_loop.windows.windowed_errors": lambda closed, indices: (closed, *indices),
        "microrad.link.error_budget.assembly.judge": lambda stated, closed: asked.append(closed) or judged,
        f"{wide}.fine_pointing.words.arrival": lambda loop: f"arrival at {loop}",
        f"{wide}.fine_pointing.data.arrival": lambda scene: {"arrival": 1},
        f"{wide}.fine_pointing.windows.windows_data": list,
        f"{wide}.fine_pointing.windows.windows_text": lambda errors, name, width, said: f"\n{name} {width} {said}\n\n",
        f"{wide}.fine_pointing.simulated_windows.simulated_data": lambda *found: list(found),
        f"{wide}.fine_pointing.simulated_windows.simulated_view": lambda *found: SimpleNamespace(blocks=found),
        f"{wide}.error_budget.data.budget_data": lambda found: {"same": found is judged},
        f"{wide}.error_budget.page.budget_view": lambda found: SimpleNamespace(blocks=["budget", found is judged]),
        f"{wide}.view.views_text": lambda blocks, width: f"\n{blocks} at {width}\n",
    }
    for name, part in parts.items():
        monkeypatch.setattr(name, part)
    monkeypatch.setenv("COLUMNS", "99")
    options = ("--controller", "LQG", "--sources", "errors.csv", "--simulate", "5")
    result = call("pointing", DEFAULT, *options, *["--json"] * as_json)
    assert asked == [
        ("errors.csv", ["short", "long"]),
        *("LQG", ("made LQG", ["short"], 5), "theory with made LQG"),
    ]
    runs = ["errors of runs", "lost", 5, ["long"], "coded"]
    assert result.code == code
    if not as_json:
        assert result.out == f"LQG 99 arrival at loop\n\n{tuple(runs)} at 99\n\n['budget', True] at 99\n"
        return
    data = json.loads(result.out)
    assert data.pop("mission_sha256") == load_mission(DEFAULT).sha256
    assert [*data.items()] == [
        ("controller", "LQG"),
        ("indices", ["theory with made LQG", "short", "long"]),
        ("arrival", 1),
        ("simulated", runs),
        ("budget", {"same": True}),
    ]
