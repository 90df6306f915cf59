"""Mission files: what is read from a good one, and what a bad one is told. Nothing but `MissionError` may come out."""

import hashlib
import json
import math
import os
import pickle
import re
import subprocess
import sys
import tomllib
from dataclasses import dataclass, replace
from pathlib import Path
from types import SimpleNamespace
from typing import Annotated

import numpy as np
import pydantic
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from made_tables import made, one_line, told
from microrad.core import lti
from microrad.core.units import UnitError
from microrad.mirror import model as mirror
from microrad.mission import model, toml
from microrad.mission.fields import Bounded, Monthly, OrWord, ProblemsError, Quantity, Several, Share, Switch, Whole
from microrad.mission.file import (
    MissionError,
    _content,
    assumptions,
    load_coupled_mirror,
    load_link,
    load_mirror,
    load_mission,
    mission_file,
    named_files,
    open_mission,
    with_values,
)
from microrad.mission.model import (
    Amplifier,
    Control,
    LinkMission,
    Mission,
    Source,
    _bias_fits,
    _frequencies_fit,
    mission_schema,
    source_text,
)
from microrad.mission.tables import mirror as mirror_table
from microrad.mission.tables.link import Receiver, half_angle_rad, obscuration_fits
from microrad.mission.tables.mirror import (
    BoucWenTable,
    Comparison,
    CreepTable,
    KeyList,
    LinearPart,
    Mirror,
    PrandtlIshlinskiiTable,
    Uncertainty,
    place,
    roots_from_damping,
)
from microrad.mission.tables.orbit import UtcEpoch
from microrad.mission.tables.pointing import Pointing, PointingLine, point_ahead_rad
from microrad.mission.toml import Document, Fault, UnreadableError, scan, shown, value_of
from microrad.studio.draft.draft import Draft
from places import ROOT
from shipped import DEFAULT, SHIPPED
from waiting import no_hang

PAPER = ROOT / "missions" / "paper.toml"
TEXT = PAPER.read_text(encoding="utf-8")
NO_MIRROR, MIRROR, REST = re.fullmatch(r"(.*)(\[mirror\]\n.*)(\[amplifier\]\n.*)", TEXT, re.DOTALL).groups()
MIRROR_TEXT = MIRROR.removeprefix("[mirror]\n").replace("[mirror.", "[")


def edited(key, value, text=TEXT, *, renamed=None):
    """The text with the value of a dotted key replaced, or with its line taken out (None), its comment kept."""
    lines = text.split("\n")
    place = next(s.line for s in scan(text) if s.key == key and s.kind == "key") - 1
    comment = lines[place].partition("  # ")[2]
    name = renamed or key.rpartition(".")[2]
    lines[place] = "" if value is None else f"{name} = {value}  # {comment}"
    return "\n".join(lines)


def line_of(key, text):
    return next(s.line for s in scan(text) if s.key == key)


@pytest.fixture
def refuse(tmp_path):
    """Write a text or bytes, load it, and return the error, checked for what every error owes its reader."""

    def load(content, mirror=None):
        path = tmp_path / "bad.toml"
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        with no_hang(), pytest.raises(MissionError) as refused:
            load_mission(path, mirror)
        error, report = refused.value, str(refused.value)
        assert error.path == path
        assert error.faults
        for fault in error.faults[:50]:
            assert fault.reason in report
            assert fault.expected
            assert fault.expected in report
            assert fault.key in report
            assert fault.value in report
            assert len(fault.value) < 200
        assert report.replace("\n", "").isprintable()
        assert "Traceback" not in report
        assert "pydantic" not in report
        return error

    return load


def the_fault(error):
    assert len(error.faults) == 1, str(error)
    return error.faults[0]


# ---- a good file
def test_the_papers_mission_is_read_in_si():
    mission = load_mission(PAPER).mission
    assert mission.communication.transmit_power_w == 5.0
    assert mission.communication.wavelength_m == 1.55e-6
    assert mission.communication.data_rate_bit_s == 300e6
    assert mission.beacon.divergence_rad == 780e-6
    assert mission.answer.required_power_w == 1e-10
    assert mission.terminals.geo_aperture_m == 0.15
    assert mission.mirror.travel_rad == 2.5e-3
    assert mission.mirror.bouc_wen.epsilon_rad_v == -48e-6
    assert mission.mirror.bouc_wen.alpha_1_v == 38.421
    assert mission.mirror.comparison.bouc_wen.beta_1_v == 0.6
    assert mission.mirror.linear.numerator == (1.979e11, 7.051e13, 2.973e13)
    assert mission.mirror.linear.denominator[0] == 1.0
    assert mission.mirror.prandtl_ishlinskii is None
    assert mission.amplifier.slew_v_s == 1e6
    assert mission.control.proportional_v_rad == 1e3
    assert mission.control.integral_v_rad_s == 16e6
    assert mission.control.for_mirror_gain_rad_v == 89e-6
    assert mission.scenario.loop_frequencies_hz == (1.0, 60.0, 80.0, 100.0)
    assert mission.requirement.residual_statistic == "peak"


def test_a_mission_file_keeps_its_origin():
    file = load_mission(str(PAPER))
    assert file.path == PAPER
    assert file.text == TEXT
    assert file.sha256 == hashlib.sha256(PAPER.read_bytes()).hexdigest()
    assert file.mirror_file is None


@pytest.mark.promise("mirror-file-6")
@pytest.mark.promise("readme-5")
@pytest.mark.promise("index-2")
@pytest.mark.promise("readme-23")
def test_every_value_has_a_source_with_its_line():
    file = load_mission(PAPER)
    lines = TEXT.split("\n")
    for key, source in file.sources.items():
        assert lines[source.line - 1].startswith(key.rpartition(".")[2] + " ="), key
    assert set(file.sources) == {s.key for s in scan(TEXT) if s.kind == "key"}
    source = file.sources["communication.transmit_power"]
    assert (source.comment, source.value, source.kind) == ("paper: Table 2", '"5 W"', "paper")
    assert source.text == "paper: Table 2"
    assert file.sources["name"].text == f"mission file, line {line_of('name', TEXT)}"


@pytest.mark.promise("mirror-file-6")
@pytest.mark.promise("index-2")
def test_the_mission_that_init_writes_says_where_each_value_comes_from():
    sources = load_mission(ROOT / "missions" / "leo-geo.toml").sources
    assert [key for key, source in sources.items() if not source.kind] == ["name", "mirror.name"]
    assert {source.kind for source in sources.values()} == {"", "paper", "literature", "assumption"}
    assert sources["communication.transmit_power"].value == '"5 W"'


def test_assumptions_are_exactly_the_lines_marked_so():
    listed = assumptions(load_mission(PAPER).sources)
    assert len(listed) == sum("# assumption:" in line or "# derived:" in line for line in TEXT.split("\n"))
    assert ("beacon.required_power", '"10 pW"') in [entry[:2] for entry in listed]
    assert all(comment.startswith(("assumption:", "derived:")) for _, _, comment in listed)


@pytest.mark.promise("mirror-file-6")
def test_sources_name_each_comment_once_and_the_lack_of_one():
    sources = {"a": Source(1, "paper: Table 2"), "b": Source(2, "paper: Table 2"), "c": Source(3, "see: there")}
    assert source_text(sources, "a", "b") == "paper: Table 2"
    assert source_text(sources, "a", "x") == "paper: Table 2; not stated"
    assert [sources[k].kind for k in "abc"] == ["paper", "paper", ""]
    assert Source(3, "paper").kind == ""


@pytest.mark.promise("mirror-file-6")
def test_the_first_word_of_a_comment_in_a_mirror_file_says_what_its_value_is(tmp_path):
    path = tmp_path / "mirror.toml"
    for word in ("paper", "assumption", "measured", "identified"):
        line = f'travel = "2.4 mrad"  # {word}: on a bench'
        path.write_text(re.sub("(?m)^travel = .*$", line, MIRROR_TEXT), encoding="utf-8")
        source = load_mirror(path).sources["mirror.travel"]
        assert (source.kind, source.comment) == (word, f"{word}: on a bench")
        listed = [key for key, *_ in assumptions(load_mission(PAPER, path).sources)]
        assert ("mirror.travel" in listed) == (word == "assumption")


@pytest.mark.promise("decisions-1")
def test_a_mission_is_frozen_and_can_be_copied_and_pickled():
    mission = load_mission(PAPER).mission
    with pytest.raises(pydantic.ValidationError):
        mission.communication.distance_m = 1.0
    assert pickle.loads(pickle.dumps(mission)) == mission
    assert hash(mission) == hash(mission.model_copy(deep=True))


def test_half_angle_by_convention():
    assert half_angle_rad(780e-6, "full-1/e2") == 390e-6
    assert half_angle_rad(780e-6, "half-1/e2") == 780e-6


def test_windows_line_ends_and_a_byte_order_mark_change_nothing(tmp_path):
    path = tmp_path / "windows.toml"
    path.write_bytes(b"\xef\xbb\xbf" + TEXT.replace("\n", "\r\n").encode())
    file = load_mission(path)
    assert file.mission == load_mission(PAPER).mission
    assert file.sources == load_mission(PAPER).sources


def test_toml_in_other_dress_is_the_same_mission(tmp_path):
    text = edited("scenario.pid_frequencies", '[ # paper: first\n  "1 Hz", # "one" ]\n  "15 Hz",\n]')
    text = text.replace("[mirror.bouc_wen]", '["mirror" . bouc_wen]')
    text = edited("pointing.lines.misalignment.error", "'248 urad'", text)
    text = "terminals.leo_aperture = '''5 cm'''\nterminals.geo_aperture = \"15\\u0020cm\"\n" + text.replace(
        re.search(r"\[terminals\]\n.*\n.*\n", text)[0], ""
    )
    path = tmp_path / "dress.toml"
    path.write_text(text, encoding="utf-8")
    file = load_mission(path)
    assert file.mission == load_mission(PAPER).mission
    assert file.sources["terminals.leo_aperture"].line == 1
    assert file.sources["scenario.inverse_frequencies"].line == line_of("scenario.inverse_frequencies", text)
    assert file.sources["mirror.bouc_wen.d1"].kind == "paper"


def test_a_key_in_an_inline_table_has_the_source_of_the_table(tmp_path):
    block = re.search(r"\[terminals\]\n.*\n.*\n", TEXT)[0]
    text = 'terminals = { leo_aperture = "5 cm", geo_aperture = "15 cm" } # standard: ours\n' + TEXT.replace(block, "")
    path = tmp_path / "inline.toml"
    path.write_text(text, encoding="utf-8")
    source = load_mission(path).sources["terminals.geo_aperture"]
    assert (source.line, source.kind) == (1, "standard")


def test_the_comment_behind_a_list_counts_before_those_inside():
    inside, behind = scan("a = [ # one\n 1, # two\n]\nb = [ # one\n] # behind\n")
    assert (inside.comment, inside.line, inside.last_line) == ("one", 1, 3)
    assert (behind.comment, behind.line, behind.last_line) == ("behind", 4, 5)


def test_a_resolution_of_zero_is_an_ideal_converter(tmp_path):
    path = tmp_path / "ideal.toml"
    text = edited("control.drive_resolution", '"0 V"', edited("control.sensor_resolution", '"0 rad"'))
    path.write_text(text, encoding="utf-8")
    control = load_mission(path).mission.control
    assert (control.drive_resolution_v, control.sensor_resolution_rad) == (0.0, 0.0)


# ---- one value wrong
@pytest.mark.promise("mirror-file-7", "mirror-file-12", "mirror-file-14", "mirror-file-17")
@pytest.mark.parametrize(
    ("key", "value", "reason", "expected"),
    [
        ("communication.transmit_power", "5", "number without a unit", 'transmit_power = "5 W"'),
        ("terminals.leo_aperture", "5", "number without a unit", 'leo_aperture = "5 cm"'),
        ("communication.distance", "42000", "number without a unit", 'distance = "42000 km"'),
        ("terminals.leo_aperture", '"5"', "number without a unit", 'leo_aperture = "5 cm"'),
        ("terminals.leo_aperture", '"-5 cm"', "not above 0 m", "above 0 m"),
        ("terminals.leo_aperture", '"0 cm"', "not above 0 m", "above 0 m"),
        ("terminals.leo_aperture", '"5 km"', "is above 100 m", "at most 100 m"),
        ("terminals.leo_aperture", '"5 urad"', "another kind of quantity", "a length"),
        ("communication.transmit_power", "nan", "number without a unit", '"5 W"'),
        ("communication.transmit_power", '"nan W"', "plain number", '"5 W"'),
        ("communication.transmit_power", '"1,5 W"', "comma", '"1.5 W"'),
        ("communication.transmit_power", "true", "not a quantity", '"5 W"'),
        ("communication.transmit_power", '["5 W"]', "not a quantity", '"5 W"'),
        ("communication.transmit_power", "2021-03-30", "not a quantity", '"5 W"'),
        ("communication.implementation_loss", '"-1 dB"', "below 0 dB", "at least 0 dB"),
        ("communication.strehl", "nan", "not a finite number", "strehl = "),
        ("communication.strehl", "-0.1", "below 0", "at least 0"),
        ("communication.strehl", '"0.4 dB"', "not a plain number", "without quotes"),
        ("amplifier.gain", "true", "not a plain number", "without quotes"),
        ("amplifier.gain", "0", "not above 0", "above 0"),
        ("amplifier.bandwidth", '"0 Hz"', "not above 0 Hz", "above 0 Hz"),
        ("amplifier.bandwidth", "inf", "number without a unit", '"5 Hz"'),
        ("amplifier.output_max", '"0 V"', "not above output_min", "above 0 V"),
        ("mirror.drive_max", '"0 V"', "not above drive_min (0 V)", "a voltage above 0 V"),
        ("conventions.strehl", '"decibels"', "none of the choices", 'strehl = "decibel" or strehl = "ratio"'),
        ("conventions.strehl", "1", "none of the choices", 'strehl = "decibel"'),
        ("mirror.composition", '"cascaded"', "none of the choices", 'composition = "cascade"'),
        ("mirror.name", '""', "is empty", "text in quotes"),
        ("mirror.name", "7", "wrong kind", "text in quotes"),
        ("mirror.bouc_wen.d1", '"0 mrad/V"', "not above 0 rad/V", "above 0"),
        ("mirror.bouc_wen.d2", '"1 V/s"', "another kind", "s/V"),
        ("mirror.linear.numerator", "[]", "not a list with something in it", "a list"),
        ("mirror.linear.numerator", "[0, 0.0]", "zero throughout", "other than 0"),
        ("mirror.linear.numerator", "[1, 2, 3, 4, 5, 6]", "no lower order than denominator", "fewer"),
        ("mirror.linear.numerator", '[1, "2"]', "item 2", "without quotes"),
        ("mirror.linear.denominator", "[0, 1, 2, 3, 4, 5]", "begins with 0", "highest power"),
        (
            "mirror.linear.denominator",
            "[1, 2, 3, 4, 5, 0]",
            "ends with 0, which makes the linear part an integrator",
            "other than 0",
        ),
        ("mirror.linear.denominator", "5", "not a list", "a list"),
        ("mirror.linear.normalise_at", '"10 kHz"', "outside excited_from to excited_to (1 Hz to 5 kHz)", "1 Hz to"),
        ("mirror.linear.normalise_at", '"0.9 Hz"', "outside excited_from to excited_to (1 Hz to 5 kHz)", "1 Hz to"),
        ("mirror.linear.excited_to", '"0.5 Hz"', "not above excited_from", "goes up"),
        ("mirror.linear.excited_to", '"1 Hz"', "not above excited_from", "goes up"),
        (
            "mirror.linear.denominator",
            "[1e-100, 1e10, 2e50, 1e20, 1, 1]",
            "begins with a factor that is nothing beside others: 1e-100 of 2e+50",
            "coefficients of at most 1e+150 times the first one",
        ),
        ("control.rate", '"0 Hz"', "not above 0 Hz", "above 0 Hz"),
        ("control.plant_step", '"7 us"', "does not divide the control period", "would do"),
        ("control.plant_step", '"1e-20 s"', "more than 1000000 times", "nearer"),
        ("control.delay", '"25 us"', "no whole number of plant_step", 'delay = "20 µs" would do'),
        ("control.delay", '"-20 us"', "below 0 s", "at least 0 s"),
        ("scenario.pid_frequencies", '["15 Hz", "1 Hz"]', "does not rise", "rising"),
        ("scenario.pid_frequencies", '["1 Hz", "1 Hz"]', "does not rise", "rising"),
        ("scenario.pid_frequencies", '["0 Hz", "1 Hz"]', "item 1", "above 0 Hz"),
        ("scenario.pid_frequencies", "[]", "not a list with something in it", "a list"),
        (
            "scenario.loop_frequencies",
            '["20 mHz", "10 Hz"]',
            "begins at 20 mHz, a period of over 2000000 control samples",
            "frequencies of at least 25 mHz",
        ),
        ("scenario.loop_frequencies", '["1 Hz", "25 kHz"]', "half of control.rate is 25 kHz", "below 25 kHz"),
        ("requirement.residual_statistic", '"mean"', "none of the choices", 'residual_statistic = "peak"'),
    ],
)
def test_one_bad_value_is_one_fault_with_key_value_line_and_advice(refuse, key, value, reason, expected):
    text = edited(key, value)
    fault = the_fault(refuse(text))
    assert (fault.key, fault.line) == (key, line_of(key, text))
    assert fault.value[:10] == value[:10]
    assert reason in fault.reason
    assert expected in fault.expected


def test_pointing_without_a_line_is_one_fault(refuse):
    lines = r"(?s)\[pointing\.lines\..*?\n(?=\[(?!pointing\.lines))"
    fault = the_fault(refuse(re.sub(lines, "[pointing.lines]\n\n", TEXT, count=1)))
    assert (fault.key, fault.reason) == ("pointing.lines", "holds no error")
    assert fault.expected == "a table such as [pointing.lines.body_pointing]"


def test_a_whole_number_beyond_floats_is_no_gain(refuse):
    fault = the_fault(refuse(edited("amplifier.gain", "0x" + "f" * 300)))
    assert (fault.key, fault.value, fault.reason) == (
        "amplifier.gain", "(a whole number of 1200 bits)", "is not a finite number"
    )  # fmt: skip


@pytest.mark.promise("mirror-file-11", "mirror-file-12")
def test_a_static_mirror_has_no_linear_part(refuse):
    text = edited("mirror.composition", '"static"')
    fault = the_fault(refuse(text))
    assert (fault.key, fault.line) == ("mirror.linear", line_of("mirror.linear", text))
    assert 'composition = "static"' in fault.reason
    assert 'composition = "cascade"' in fault.expected


def test_a_bias_outside_the_amplifier_names_both(refuse):
    text = edited("mirror.bias", '"11 V"', edited("amplifier.output_max", '"150 V"'))
    fault = the_fault(refuse(text))
    assert (fault.key, fault.value, fault.line) == ("mirror.bias", '"11 V"', line_of("mirror.bias", text))
    assert "amplifier.output_min to amplifier.output_max divided by amplifier.gain" in fault.reason
    assert fault.expected == "0 V to 10 V"


@pytest.mark.promise("mirror-file-12", "mirror-file-17")
@pytest.mark.parametrize(
    ("key", "value", "fault_key", "reason"),
    [
        ("mirror.bias", '"13 V"', "mirror.bias", "is outside drive_min to drive_max (0 V to 12 V)"),
        ("mirror.drive_min", '"9 V"', "mirror.bias", "is outside drive_min to drive_max (9 V to 12 V)"),
        ("mirror.bouc_wen.alpha", '"34.635 1/V"', "mirror.bouc_wen.alpha", "not above the size of beta (34.64 1/V)"),
        ("mirror.drive_max", '"-1 V"', "mirror.drive_max", "is not above drive_min (0 V)"),
        (
            "mirror.bouc_wen.alpha",
            '"34 1/V"',
            "mirror.bouc_wen.alpha",
            "not above the size of beta (34.64 1/V), so h would grow without bound",
        ),
        (
            "mirror.bouc_wen.beta",
            '"34.635 1/V"\ngamma = "5 1/V"',
            "mirror.bouc_wen.alpha",
            "not above the size of what beta, gamma and eta take off it (39.64 1/V), so h would grow without bound",
        ),
        (
            "mirror.bouc_wen.beta",
            '"34.635 1/V"\neta = "-4 1/V"',
            "mirror.bouc_wen.alpha",
            "not above the size of what beta, gamma and eta take off it (38.64 1/V), so h would grow without bound",
        ),
        ("mirror.bouc_wen.beta", '"34.635 1/V"\nexponent = 0.9', "mirror.bouc_wen.exponent", "below 1"),
        ("mirror.bouc_wen.beta", '"34.635 1/V"\nexponent = 101', "mirror.bouc_wen.exponent", "above 100"),
        ("mirror.bouc_wen.beta", '"34.635 1/V"\ngamma = 1', "mirror.bouc_wen.gamma", "number without a unit"),
    ],
)
def test_what_a_mirror_was_identified_for_fits_together(refuse, key, value, fault_key, reason):
    fault = the_fault(refuse(edited(key, value)))
    assert fault.key == fault_key
    assert reason in fault.reason


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("mirror.bias", '"0 V"'),
        ("mirror.bias", '"12 V"'),
        ("mirror.linear.normalise_at", '"1 Hz"'),
        ("mirror.linear.normalise_at", '"5 kHz"'),
        ("mirror.linear.numerator", "[0, 1, 2, 3, 4, 5]"),
        ("mirror.linear.denominator", "[1e-100, 1e10, 9e49, 1e20, 1, 1]"),
        ("mirror.bouc_wen.alpha", '"34.636 1/V"'),
        ("mirror.bouc_wen.beta", '"34.635 1/V"\nexponent = 1.0'),
        ("mirror.bouc_wen.beta", '"34.635 1/V"\nexponent = 100.0'),
        ("scenario.loop_frequencies", '["25 mHz", "24.9 kHz"]'),
        ("control.plant_step", '"20 us"'),
    ],
)
def test_what_meets_a_limit_of_a_mission_is_taken(tmp_path, key, value):
    path = tmp_path / "limit.toml"
    path.write_text(edited(key, value), encoding="utf-8")
    assert key in load_mission(path).sources


@pytest.mark.promise("mirror-file-17", "mirror-file-18")
def test_the_asymmetry_that_is_taken_is_the_one_that_keeps_h_bounded():
    """In both directions and on both sides of zero the decay of |h| is above 0, and nothing else is asked for."""
    rng, taken = np.random.default_rng(1), 0
    for beta, gamma, eta in rng.uniform(-1.5, 1.5, (300, 3)):
        given = {"d1": "1 mrad/V", "d2": "0 s/V", "epsilon": "-1 mrad/V", "delta": "0 s/V", "alpha": "1 1/V"}
        given |= {"beta": f"{beta} 1/V", "gamma": f"{gamma} 1/V", "eta": f"{eta} 1/V"}
        decays = [1.0 + beta * r * s + gamma * s + eta * r for r in (1, -1) for s in (1, -1)]
        if min(decays) > 0.0:
            taken += BoucWenTable.model_validate(given).gamma_1_v == gamma
            continue
        with pytest.raises(pydantic.ValidationError, match=r"alpha is not above.*so h would grow without bound"):
            BoucWenTable.model_validate(given)
    assert 30 < taken < 270


@pytest.mark.promise("mirror-file-12", "mirror-file-17")
def test_what_generalises_a_model_may_be_left_out(tmp_path):
    plain = load_mission(PAPER).mission.mirror
    assert (plain.bouc_wen.gamma_1_v, plain.bouc_wen.eta_1_v, plain.bouc_wen.exponent) == (0.0, 0.0, 1.0)
    assert plain.creep is None
    text = edited("mirror.bouc_wen.beta", '"30 1/V"\ngamma = "5 1/V"\neta = "-2 1/V"\nexponent = 1.5')
    path = tmp_path / "asymmetric.toml"
    path.write_text(text + CREEP, encoding="utf-8")
    mirror = load_mission(path).mission.mirror
    assert (mirror.bouc_wen.gamma_1_v, mirror.bouc_wen.eta_1_v, mirror.bouc_wen.exponent) == (5.0, -2.0, 1.5)
    assert mirror.creep.time_constants_s == (0.1, 1.0)
    assert mirror.creep.weights_rad_v == (2e-6, -1e-6)


CREEP = """
[mirror.creep]
time_constants = ["100 ms", "1 s"]
weights = ["2 urad/V", "-1 urad/V"]
"""


@pytest.mark.promise("mirror-file-22")
@pytest.mark.parametrize(
    ("old", "new", "key", "reason", "expected"),
    [
        ('"100 ms", "1 s"', '"1 s"', "weights", "has 2 items where time_constants has 1", "one weight for each"),
        ('"-1 urad/V"', '"1 urad"', "weights", "item 2", "angle per voltage"),
        ('"100 ms"', '"0 s"', "time_constants", "item 1", "above 0"),
        ('"100 ms"', '"2 s"', "time_constants", "does not rise", "rising"),
    ],
)
@pytest.mark.promise("mirror-file-59")
def test_creep_has_a_weight_for_each_lag(refuse, old, new, key, reason, expected):
    assert CREEP.count(old) == 1
    fault = the_fault(refuse(TEXT + CREEP.replace(old, new)))
    assert fault.key == f"mirror.creep.{key}"
    assert reason in fault.reason
    assert expected in fault.expected


@pytest.mark.parametrize("value", ["0", "1.2"])
def test_a_strehl_ratio_is_above_zero_and_at_most_one(refuse, value):
    text = edited("conventions.strehl", '"ratio"', edited("beacon.strehl", value))
    fault = the_fault(refuse(text))
    assert (fault.key, fault.value) == ("beacon.strehl", value)
    assert 'conventions.strehl = "ratio"' in fault.reason
    assert 'conventions.strehl = "decibel"' in fault.expected


def test_the_plant_step_named_would_indeed_do(refuse, tmp_path):
    text = edited("control.delay", '"0 s"', edited("control.plant_step", '"7 us"'))
    better = re.search(r'plant_step = ("[^"]+")', the_fault(refuse(text)).expected)[1]
    path = tmp_path / "better.toml"
    path.write_text(edited("control.plant_step", better, text), encoding="utf-8")
    assert load_mission(path).mission.control.plant_step_s == pytest.approx(20e-6 / 3, rel=1e-9)


@pytest.mark.parametrize("step", ['"10.000000001 us"', '"20 us"', '"5000 ns"'])
def test_steps_within_the_tolerance_are_taken(tmp_path, step):
    path = tmp_path / "step.toml"
    path.write_text(edited("control.plant_step", step), encoding="utf-8")
    assert load_mission(path).mission.control.plant_step_s > 0.0


# ---- keys and tables
@pytest.mark.promise("mirror-file-5")
@pytest.mark.promise("decisions-1")
def test_an_unknown_key_is_shown_with_the_nearest_and_not_missed_as_well(refuse):
    text = edited("communication.wavelength", '"1.55 um"', renamed="wavelenght")
    fault = the_fault(refuse(text))
    assert (fault.key, fault.nearest) == ("communication.wavelenght", "wavelength")
    assert fault.line == line_of("communication.wavelenght", text)
    assert "transmit_power" in fault.expected


def test_an_unknown_key_like_no_other_lists_what_there_is(refuse):
    fault = the_fault(refuse(TEXT.replace("[scenario]\n", '[scenario]\nzzz = "1 V"\n')))
    assert (fault.key, fault.nearest, fault.value) == (
        "scenario.zzz",
        "",
        "",
    )  # what a file of ours does not have is not quoted
    assert "amplitude, pid_frequencies" in fault.expected


def test_a_key_that_is_missing_is_the_likelier_one_to_have_been_meant(refuse):
    text = edited("amplifier.output_max", '"180 V"', renamed="output_mi")  # nearer to output_min, which is there
    fault = the_fault(refuse(text))
    assert (fault.key, fault.nearest) == ("amplifier.output_mi", "output_max")


def test_a_missing_key_is_told_with_its_table_and_an_example(refuse):
    text = edited("communication.data_rate", None)
    fault = the_fault(refuse(text))
    assert (fault.key, fault.value, fault.reason) == ("communication.data_rate", "", "is missing")
    assert fault.line == line_of("communication", text)
    assert 'data_rate = "5 Mbit/s"' in fault.expected


@pytest.mark.promise("decisions-1")
def test_each_quantity_of_a_mission_refuses_another_kind_of_unit():
    tried = set()
    for path in (SHIPPED, DEFAULT):
        for key, value in Draft.open(path).values.items():
            rule = getattr(value.about, "rule", None)
            if isinstance(rule, Quantity) and rule.unit:
                number = rule.example.partition(" ")[0]
                assert rule.read(rule.example) > -math.inf
                with pytest.raises(UnitError):
                    rule.read(f"{number} {'s' if rule.unit != 's' else 'V'}")
                with pytest.raises(UnitError):
                    rule.read(float(number))
                tried.add(key)
    assert len(tried) > 100


STRIDE = 20


@pytest.mark.promise("decisions-1")
def test_no_quantity_of_a_mission_has_a_default(refuse):
    """Many keys at once that stand far from each other; what is not told beside the others is so by itself."""

    def told(text, key):
        # a linear part lacks one of its two forms, so that its table is named
        form = key in ("mirror.linear.numerator", "mirror.linear.denominator")
        # and an orbit lacks its node, however that is given
        named = "mirror.linear" if form else key.replace("local_time", "node")
        return named in [fault.key for fault in refuse(text).faults]

    every, place = list(load_mission(PAPER).sources), {s.key: s.line - 1 for s in scan(TEXT) if s.kind == "key"}
    for first in range(STRIDE):
        lines = TEXT.split("\n")
        for key in every[first::STRIDE]:
            lines[place[key]] = ""
        found = [fault.key for fault in refuse("\n".join(lines)).faults]
        alone = [key for key in every[first::STRIDE] if key not in found]
        assert [key for key in alone if not told(edited(key, None), key)] == []


def test_a_missing_table_is_one_fault(refuse):
    block = re.search(r"\[answer\]\n.*?\n\n", TEXT, re.DOTALL)[0]
    fault = the_fault(refuse(TEXT.replace(block, "")))
    assert (fault.key, fault.reason) == ("answer", "is missing")
    assert "a table with the keys transmit_power" in fault.expected


def test_a_misspelled_table_is_one_fault(refuse):
    text = TEXT.replace("[amplifier]", "[amplifyer]")
    fault = the_fault(refuse(text))
    assert (fault.key, fault.nearest) == ("amplifyer", "amplifier")
    assert fault.line == line_of("amplifyer", text)


@pytest.mark.parametrize("value", ["5", '"x"', "[1]", "[[1]]"])
def test_a_value_where_a_table_belongs(refuse, value):
    block = re.search(r"\[answer\]\n.*?\n\n", TEXT, re.DOTALL)[0]
    fault = the_fault(refuse(f"answer = {value}\n" + TEXT.replace(block, "")))
    assert (fault.key, fault.line, fault.value) == ("answer", 1, value)
    assert "a table with the keys" in fault.expected


def test_a_list_of_tables_where_a_table_belongs(refuse):
    fault = the_fault(refuse(TEXT.replace("[answer]", "[[answer]]")))
    assert fault.key == "answer"
    assert "wrong kind" in fault.reason


def test_a_table_where_a_value_belongs(refuse):
    text = edited("communication.distance", '{ value = "1 km" }')
    fault = the_fault(refuse(text))
    assert (fault.key, fault.value) == ("communication.distance", "(a table)")


# ---- everything at once
@pytest.mark.promise("decisions-1", "readme-5")
def test_all_faults_are_reported_at_once_in_the_order_of_the_file(refuse):
    text = edited("pointing.lines.body_pointing.error", '"-1 urad"')
    text = edited("terminals.leo_aperture", "5 cm", text)  # no quotes: not TOML
    text = edited("conventions.divergence", '"full"', text)
    text = edited("beacon.distance", "44000", text)
    text = edited("communication.wavelength", '"1.55 um"', text, renamed="wavelenght")
    text = edited("communication.data_rate", None, text)
    text = edited("mirror.bias", '"6 V"\nbias = "7 V"', text)
    text = edited("control.plant_step", '"7 us"', text)
    text = edited("scenario.pid_frequencies", '["1 Hz", "15 Hz"', text)  # not closed
    text = edited("scenario.loop_amplitude", '"6 V', text)  # not closed
    error = refuse(text.replace("[requirement]", "[requirement"))
    keys = [
        "pointing.lines.body_pointing.error", "terminals.leo_aperture", "conventions.divergence", "beacon.distance",
        "communication.data_rate", "communication.wavelenght", "", "mirror.bias", "control.plant_step",
        "scenario.pid_frequencies", "scenario.loop_amplitude",
    ]  # fmt: skip
    assert sorted(fault.key for fault in error.faults) == sorted(keys)
    assert [fault.line for fault in error.faults] == sorted(fault.line for fault in error.faults)
    assert f"{len(keys)} faults to correct" in str(error)


def test_relations_are_checked_beside_other_faults(refuse):
    text = edited("mirror.bias", '"13 V"', edited("beacon.distance", "44000"))
    assert {fault.key for fault in refuse(text).faults} == {"mirror.bias", "beacon.distance"}


def test_a_duplicate_key_names_both_lines_beside_other_faults(refuse):
    text = edited("mirror.bias", '"6 V"\nbias = "7 V"', edited("beacon.distance", "44000"))
    faults = {fault.key: fault for fault in refuse(text).faults}
    first = line_of("mirror.bias", text)
    assert set(faults) == {"mirror.bias", "beacon.distance"}
    assert faults["mirror.bias"].line == first + 1
    assert faults["mirror.bias"].value == '"7 V"'
    assert f"on lines {first} and {first + 1}" in faults["mirror.bias"].reason


def test_a_duplicate_table_names_both_lines(refuse):
    text = TEXT + '\n[beacon]\ntransmit_power = "4 W"\n'
    fault = the_fault(refuse(text))
    assert f"on lines {line_of('beacon', TEXT)} and {len(TEXT.split(chr(10))) + 1}" in fault.reason


@pytest.mark.parametrize(
    ("broken", "reason"),
    [
        ("5 W", "not TOML"),
        ("", "has no value"),
        ('"5 W', "not TOML"),
        ('"5 \\q W"', "not TOML"),
        ('["5 W"', "not closed"),
        ("2020-13-40", "not TOML"),
        ("9" * 5000, "number of 5000 characters"),
        ("[" * 40 + "]" * 40, "nested 40 brackets deep"),
        ("[" * 100_000 + "]" * 100_000, "nested 100000 brackets deep"),
        ("[" * 100_000, "nested 100000 brackets deep"),
        ("{a=" * 1000 + "1" + "}" * 1000, "nested 1000 brackets deep"),
        # These took the parser minutes: it goes through all parts for each part.
        ("{a" + ".a" * 400_000 + " = 1}", "holds a key of more than 50 parts"),
        ("[[{b = 1, " + "'a' . " * 100_000 + "a = 1}]]", "holds a key of more than 50 parts"),
    ],
)
def test_what_is_not_toml_names_its_line_and_key(refuse, broken, reason):
    text = edited("communication.transmit_power", broken)
    fault = the_fault(refuse(text))
    assert (fault.key, fault.line) == ("communication.transmit_power", line_of("communication.transmit_power", text))
    assert reason in fault.reason


@pytest.mark.parametrize("name", ["k\\u001b[31mX", "a\\u202Eb", "a\\nb", "a\\u0000"])
def test_a_name_that_would_steer_the_terminal_is_refused(refuse, name):
    """It was printed as it stood, and written into tables."""
    text = TEXT.replace("[operations.downlink.stations.kiruna]", f'[operations.downlink.stations."{name}"]')
    assert text != TEXT
    error = refuse(text)
    assert any("with characters that cannot be printed" in fault.reason for fault in error.faults)
    assert all(c.isprintable() or c == "\n" for c in str(error))


def test_dots_that_are_no_key_are_left_alone():
    text = f'name = "{"a." * 60}"\nx = {{a.b.c = "{"a " * 60}", d = 1.5}}\n'
    assert Document.of(text.encode(), Path("x.toml"), "mission file").data["x"]["a"]["b"]["c"] == "a " * 60


@pytest.mark.parametrize("line", ["what is this", "= 5", "[answer", "[]", "[[", "]"])
def test_a_line_that_is_no_toml_is_named(refuse, line):
    text = TEXT.replace("[answer]\n", f"[answer]\n{line}\n") if line != "[answer" else TEXT.replace("[answer]", line)
    fault = the_fault(refuse(text))
    assert (fault.line, fault.value) == (text.split("\n").index(line) + 1, "")


@pytest.mark.parametrize(
    "text",
    [
        "hunter2\nroot:hunter2:0\n",
        "PASSWORD=hunter2\nTOKEN = 'hunter2\n",
        '[default]\nkey = "hunter2"\nkeys = [{a = "hunter2"}]\n',
        "-----BEGIN KEY-----\nhunter2==\n[hunter2\n",
    ],
)
def test_the_lines_of_a_file_that_is_none_of_ours_are_not_quoted(tmp_path, text):
    """A mission names its mirror file, and whoever reads the faults need not be who may read that file."""
    (tmp_path / "secret").write_text(text, encoding="utf-8")
    with pytest.raises(MissionError) as refused:
        load_mission(tmp_path / "m.toml", text=f'{NO_MIRROR}[mirror]\nfile = "secret"\n{REST}')
    lines = {fault.line for fault in refused.value.faults if fault.line}
    assert "hunter2" not in str(refused.value)
    assert lines
    assert all(f"secret, line {line}" in str(refused.value) for line in lines)


@pytest.mark.parametrize(
    ("given", "apart"),
    [
        ("r\u0430ndom", "holds U+0430 (CYRILLIC SMALL LETTER A)"),
        ("random\ufe0f", "holds U+FE0F (VARIATION SELECTOR-16)"),
        ("random ", "begins or ends with a blank"),
    ],
)
def test_a_choice_that_looks_like_what_is_meant_is_told_apart(refuse, given, apart):
    """The hint read: class = "random" is none of the choices, did you mean "random"?"""
    fault = the_fault(refuse(TEXT.replace('class = "random"', f'class = "{given}"')))
    assert (fault.reason, fault.nearest) == (f"is none of the choices, it {apart}", '"random"')


def test_a_key_that_looks_like_what_is_meant_is_told_apart(refuse):
    fault = the_fault(refuse(TEXT.replace("transverse_velocity = ", '"tr\u0430nsverse_velocity" = ')))
    assert (fault.reason.partition(", ")[2], fault.nearest) == (
        "it holds U+0430 (CYRILLIC SMALL LETTER A)",
        "transverse_velocity",
    )


# ---- files that are none
@pytest.mark.parametrize(
    ("content", "reason"),
    [
        (b"", "is empty"),
        (b" \n\t\n", "is empty"),
        (bytes(range(256)) * 10, "binary"),
        (TEXT.encode("utf-16"), "binary"),
        (TEXT.replace("urad", "µrad").encode("latin-1"), "not UTF-8 text (line 1)"),
        (b"a = 1\n" * 10_001, "more than 10000 lines"),
        (b"#" * 1_000_001, "larger than 1000 kB"),
        (b"x = [\n" * 2_000_000, "larger than 1000 kB"),
    ],
    ids=["empty", "blank", "binary", "utf-16", "latin-1", "lines", "megabyte", "ten megabytes"],
)
def test_what_is_no_text_file_is_refused_whole(refuse, content, reason):
    fault = the_fault(refuse(content))
    assert reason in fault.reason
    assert (fault.key, fault.line) == ("", 0)


@pytest.mark.parametrize("load", [load_mission, load_mirror])
@pytest.mark.parametrize(
    ("path", "reason"),
    [
        ("missing.toml", "does not exist"),
        (".", "is a directory"),
        ("a\0b", "null"),
        ("x" * 5000, "cannot be read"),
        ("\x1b[2J", "exist"),
    ],
)
def test_a_path_that_leads_to_no_file(tmp_path, load, path, reason):
    with pytest.raises(MissionError, match=reason) as refused:
        load(tmp_path / path)
    assert str(refused.value).replace("\n", "").isprintable()


@pytest.mark.parametrize(
    ("load", "command"), [(load_mission, "init"), (load_mirror, "identify"), (load_coupled_mirror, "identify")]
)
@pytest.mark.parametrize("content", [None, ""])
def test_a_file_that_is_missing_or_empty_is_written_by_the_command_for_it(tmp_path, load, command, content):
    path = tmp_path / "a.toml"
    if content is not None:
        path.write_text(content, encoding="utf-8")
    with pytest.raises(MissionError) as refused:
        load(path)
    assert f"`microrad {command}` writes one" in the_fault(refused.value).expected


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="needs named pipes")
def test_a_pipe_is_not_waited_for(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(MissionError, match="is not a regular file"):
        load_mission(tmp_path / "pipe")


LARGE_NONSENSE = {
    "one key again and again": lambda: "a = 1\n" * 9_000,
    "one table again and again": lambda: "[a]\n" * 9_000,
    "one list of tables": lambda: "[[a]]\n" * 9_000,
    "unknown keys": lambda: "\n".join(f"k{i} = 1" for i in range(9_000)),
    "unknown tables": lambda: "\n".join(f"[k{i}]" for i in range(9_000)),
    "lines of junk": lambda: "junk\n" * 9_000,
    "a dotted key": lambda: "a." * 100_000 + "b = 1",
    "a dotted header": lambda: "[" + "a." * 100_000 + "b]",
    "a long key": lambda: "a" * 900_000,
    "lines": lambda: "a = 1\n" * 160_000,
    "a long list": lambda: "a = [" + "1,\n" * 9_000 + "]",
    "a long list of numbers for a key": lambda: edited("mirror.linear.numerator", "[" + "1," * 60_000 + "1]"),
    "a long list of texts for a key": lambda: edited("scenario.pid_frequencies", "[" + '"x",' * 30_000 + "1]"),
    "quotes in a text": lambda: 'a = """' + '\\"""' * 100_000,
    "quotes in a literal text": lambda: "a = '''" + "''" * 300_000,
    "quotes alone": lambda: '"' * 900_000,
    "nested tables": lambda: "a = {" * 150_000,
    "lists opened and not closed": lambda: "a = [\n" * 9_000,
    "a hexadecimal number": lambda: "a = 0x" + "f" * 900_000,
    "a decimal number in a list": lambda: "a = [" + "9" * 900_000 + "]",
    "headers cut short": lambda: "[a\n" * 9_000,
}


@pytest.mark.parametrize("name", LARGE_NONSENSE)
def test_a_megabyte_of_nonsense_is_refused_in_little_time_and_few_words(refuse, name):
    assert len(str(refuse(LARGE_NONSENSE[name]()))) < 40_000


def test_long_values_are_shortened_and_control_characters_escaped(refuse):
    long = the_fault(refuse(edited("communication.transmit_power", '"' + "x" * 90_000 + '"')))
    assert long.value.endswith('…"')
    assert len(long.value) < 100
    ringing = the_fault(refuse(edited("communication.transmit_power", '"5 W\\u0007\\u001b[31m\\u202e"')))
    assert ringing.value == '"5 W\\u0007\\u001b[31m\\u202e"'
    of_name, of_key = refuse(TEXT.replace("[scenario]\n", '[scenario]\n"\\u001bkey" = 1\n')).faults
    assert of_name.key == of_key.key == "scenario.\\u001bkey"


# ---- mirrors
PLAY = """
[prandtl_ishlinskii]
thresholds = ["0 V", "0.5 V", "1 V"]
weights = ["60 urad/V", "20 urad/V", "0 urad/V"]
"""
MIRROR_WITHOUT_MODEL = re.sub(r"\[bouc_wen\].*", "", MIRROR_TEXT, flags=re.DOTALL)


@pytest.mark.promise("mirror-file-1", "mirror-file-2")
def test_a_mirror_file_stands_for_the_mirror_table(tmp_path):
    (tmp_path / "lab").mkdir()
    (tmp_path / "lab" / "mirror.toml").write_text(MIRROR_TEXT, encoding="utf-8")
    path = tmp_path / "mission.toml"
    path.write_text(f'{NO_MIRROR}[mirror]\nfile = "lab/mirror.toml"\n{REST}', encoding="utf-8")
    file = load_mission(path)
    assert file.mission == load_mission(PAPER).mission
    assert file.mirror_file.path == tmp_path / "lab" / "mirror.toml"
    assert file.mirror_file.text == MIRROR_TEXT
    assert file.mirror_file.sha256 == hashlib.sha256(MIRROR_TEXT.encode()).hexdigest()
    assert file.sources["mirror.bouc_wen.d1"].line == line_of("bouc_wen.d1", MIRROR_TEXT)
    assert file.sources["mirror.bouc_wen.d1"].file == "mirror file"
    assert "mirror.file" not in file.sources
    assert set(file.sources) == set(load_mission(PAPER).sources)
    assert file.mirror_file.sources["mirror.travel"] == file.sources["mirror.travel"]


@pytest.mark.promise("mirror-file-2")
def test_a_mirror_from_the_command_line_replaces_the_missions(tmp_path):
    mirror = tmp_path / "play.toml"
    mirror.write_text(MIRROR_WITHOUT_MODEL.replace('"2.5 mrad"', '"2 mrad"  #') + PLAY, encoding="utf-8")
    file = load_mission(PAPER, mirror)
    assert file.mission.mirror.travel_rad == 2e-3
    assert file.mission.mirror.bouc_wen is None
    assert file.mission.mirror.prandtl_ishlinskii.thresholds_v == (0.0, 0.5, 1.0)
    assert file.mission.mirror.prandtl_ishlinskii.weights_rad_v == (60e-6, 20e-6, 0.0)
    assert file.mirror_file.path == mirror
    assert load_mirror(mirror).mirror == file.mission.mirror
    assert not any(key.startswith("mirror.bouc_wen") for key in file.sources)


@pytest.mark.promise("mirror-file-20")
def test_plays_widen_where_the_file_says_so(refuse, tmp_path):
    mirror = tmp_path / "play.toml"
    mirror.write_text(MIRROR_WITHOUT_MODEL + PLAY, encoding="utf-8")
    assert load_mission(PAPER, mirror).mission.mirror.prandtl_ishlinskii.widening_s == 0.0
    mirror.write_text(MIRROR_WITHOUT_MODEL + PLAY + 'widening = "0.1 ms"\n', encoding="utf-8")
    assert load_mission(PAPER, mirror).mission.mirror.prandtl_ishlinskii.widening_s == pytest.approx(1e-4)
    mirror.write_text(MIRROR_WITHOUT_MODEL + PLAY + 'widening = "-0.1 ms"\n', encoding="utf-8")
    fault = the_fault(refuse(TEXT, mirror))
    assert (fault.key, fault.value) == ("mirror.prandtl_ishlinskii.widening", '"-0.1 ms"')
    assert "below 0" in fault.reason


@pytest.mark.promise("mirror-file-2")
def test_faults_of_a_mirror_file_name_that_file_beside_those_of_the_mission(refuse, tmp_path):
    mirror = tmp_path / "mirror.toml"
    text = edited("bouc_wen.d1", "0.089", edited("travel", '"2.5 m"', MIRROR_TEXT))
    mirror.write_text(text, encoding="utf-8")
    error = refuse(edited("beacon.distance", "44000"), mirror)
    found = {(fault.file, fault.key, fault.line) for fault in error.faults}
    assert found == {
        (str(tmp_path / "bad.toml"), "beacon.distance", line_of("beacon.distance", TEXT)),
        (str(mirror), "mirror.travel", line_of("travel", text)),
        (str(mirror), "mirror.bouc_wen.d1", line_of("bouc_wen.d1", text)),
    }
    assert f"{mirror}, line {line_of('travel', text)}: mirror.travel" in str(error)


@pytest.mark.promise("mirror-file-2")
@pytest.mark.parametrize(
    ("table", "reason"),
    [
        ('file = "nowhere.toml"\n', "the mirror file does not exist"),
        ('file = "."\n', "the mirror file is a directory"),
        ("file = 5\n", "is no path"),
        ('file = ""\n', "is no path"),
        ('file = "mirror.toml"\nbias = "6 V"\n', "stands beside other keys"),
    ],
)
def test_a_mirror_file_that_is_not_there_is_one_fault_beside_others(refuse, table, reason):
    text = edited("beacon.distance", "44000", f"{NO_MIRROR}[mirror]\n{table}{REST}")
    faults = refuse(text).faults
    assert len(faults) == 2
    assert any(reason in fault.reason for fault in faults)
    assert any(fault.key == "beacon.distance" for fault in faults)


def test_a_mirror_file_that_is_no_toml(refuse, tmp_path):
    mirror = tmp_path / "mirror.toml"
    mirror.write_text(edited("travel", "2.5 mrad", MIRROR_TEXT), encoding="utf-8")
    fault = the_fault(refuse(TEXT, mirror))
    assert (fault.file, fault.key, fault.line) == (str(mirror), "mirror.travel", line_of("travel", MIRROR_TEXT))
    with pytest.raises(MissionError, match=r"mirror\.travel = 2\.5 mrad"):
        load_mirror(mirror)


@pytest.mark.promise("mirror-file-12", "mirror-file-20", "mirror-file-23")
@pytest.mark.parametrize(
    ("body", "key", "reason"),
    [
        ("", "mirror", "no hysteresis model"),
        (PLAY + MIRROR_TEXT[MIRROR_TEXT.index("[bouc_wen]") :], "mirror", "two hysteresis models"),
        (PLAY + "[comparison]\n", "mirror.comparison", "no hysteresis model"),
        (PLAY.replace('"0 V", ', ""), "mirror.prandtl_ishlinskii.thresholds", "does not begin at 0 V"),
        (PLAY.replace('"0 V", ', ""), "mirror.prandtl_ishlinskii.weights", "3 items where thresholds has 2"),
        (PLAY.replace('"1 V"', '"0.5 V"'), "mirror.prandtl_ishlinskii.thresholds", "does not rise"),
        (PLAY.replace('"20 u', '"-20 u'), "mirror.prandtl_ishlinskii.weights", "item 2"),
        (PLAY.replace("60", "0").replace("20 ", "0 "), "mirror.prandtl_ishlinskii.weights", "zero throughout"),
    ],
)
def test_what_a_mirror_must_hold(tmp_path, body, key, reason):
    path = tmp_path / "mirror.toml"
    path.write_text(MIRROR_WITHOUT_MODEL + body, encoding="utf-8")
    with pytest.raises(MissionError) as refused:
        load_mirror(path)
    assert any(fault.key == key and reason in fault.reason for fault in refused.value.faults), str(refused.value)


@pytest.mark.promise("mirror-file-11", "mirror-file-12")
def test_a_cascade_needs_its_linear_part(tmp_path):
    path = tmp_path / "mirror.toml"
    text = re.sub(r"\[linear\].*?(?=\[bouc_wen\])", "", MIRROR_TEXT, flags=re.DOTALL)
    path.write_text(text, encoding="utf-8")
    with pytest.raises(MissionError) as refused:
        load_mirror(path)
    fault = the_fault(refused.value)
    assert (fault.key, fault.line) == ("mirror.composition", line_of("composition", text))
    assert 'composition = "static"' in fault.expected
    path.write_text(text.replace('"cascade"', '"static"'), encoding="utf-8")
    assert load_mirror(path).mirror.linear is None


# ---- whatever is typed
SIGNS = [*"[]{}\"'=.,#\\ \n\t\x7fé", "[[", "\r\n", '"""', "'''", "\\u0000"]
WORDS = [
    "[mirror]",
    "[beacon]",
    "name",
    "bias = ",
    "file = ",
    '"6 V"',
    "5 W",
    "nan",
    "1e999",
    "true",
    "1979-05-27",
    "a.b",
]
FRAGMENTS = st.sampled_from(SIGNS + WORDS)


@settings(deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=80)
@given(st.integers(0, len(TEXT)), st.integers(0, 60), st.lists(FRAGMENTS, max_size=6))
def test_a_file_damaged_anywhere_raises_nothing_else(tmp_path, start, length, fragments):
    path = tmp_path / "fuzz.toml"
    path.write_bytes((TEXT[:start] + "".join(fragments) + TEXT[start + length :]).encode())
    try:
        file = load_mission(path)
    except MissionError as error:
        assert error.faults
        assert len(str(error)) < 20_000
        return
    assert isinstance(file.mission, Mission)


@settings(deadline=None)
@given(st.lists(FRAGMENTS, max_size=30))
def test_the_scanner_covers_what_the_parser_reads(fragments):
    text = "".join(fragments)
    statements = scan(text)
    assert [s.line for s in statements] == sorted(s.line for s in statements)
    try:
        data = tomllib.loads(text)
    except (tomllib.TOMLDecodeError, ValueError):
        return
    named = {s.key.partition(".")[0].partition("#")[0] for s in statements}
    assert {key for key in data if key and "." not in key and "#" not in key and key.isprintable()} <= named | {
        "\\u0000"
    }


# ---- schema and start-up
OPTIONAL = {"fine_pointing", "point_ahead", "acquisition", "orbit", "operations", "constellation"}


def test_the_schema_describes_every_key():
    schema = mission_schema()
    json.dumps(schema)
    power = schema["$defs"]["Communication"]["properties"]["transmit_power"]
    assert power["type"] == "string"
    assert power["x-si-unit"] == "W"
    assert re.search(power["pattern"], "5 W")
    assert re.search(power["pattern"], "37 dBm")
    assert not re.search(power["pattern"], "5")
    assert not re.search(power["pattern"], "1,5 W")
    assert schema["$defs"]["Amplifier"]["properties"]["gain"]["exclusiveMinimum"] == 0.0
    assert schema["properties"]["mirror"]["anyOf"][1]["required"] == ["file"]
    assert schema["additionalProperties"] is False
    tables = {key.partition(".")[0] for key in load_mission(PAPER).sources}
    assert set(schema["required"]) == tables - OPTIONAL
    assert "fine_pointing" in schema["properties"]
    for key, source in load_mission(PAPER).sources.items():
        table, name = schema, key.rpartition(".")[2]
        for part in key.split(".")[:-1]:
            table = _table(schema, table["properties"][part])
        rule = table["properties"][name]
        if "pattern" in rule:
            assert re.search(rule["pattern"], source.value.strip('"')), key


class _Named(dict):
    """Tables that each have a name of their own."""

    def __missing__(self, name):
        return self["any"]


def _table(schema, rule):
    if rule.get("type") == "object":
        return {"properties": _Named(any=rule["additionalProperties"])}
    reference = next(r["$ref"] for r in (rule, *rule.get("anyOf", [])) if "$ref" in r)
    return schema["$defs"][reference.rpartition("/")[2]]


def test_importing_the_mission_loads_no_numerics():
    code = "import sys, microrad.mission.file; print([m for m in ('numpy', 'scipy', 'numba') if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


# --------------------------------------------------------------------------------------- a linear part by its roots
ROOTS = """[mirror.linear]
poles = ["0.0343 Hz", "54.22 Hz", "1552.7 Hz", "2542.7 Hz"]
pole_dampings = [1, 1, 1, 0.357]
zeros = ["0.0672 Hz", "56.64 Hz"]
zero_dampings = [1, 1]
normalise_at = "2 Hz"
excited_from = "1 Hz"
excited_to = "5 kHz"

"""


def with_roots(*changes):
    """The paper's mission with its linear part by roots, and texts in it replaced."""
    table = ROOTS
    for old, new in changes:
        assert table.count(old) == 1, old
        table = table.replace(old, new)
    start, end = TEXT.index("[mirror.linear]"), TEXT.index("[mirror.bouc_wen]")
    return TEXT[:start] + table + TEXT[end:]


@pytest.mark.promise("mirror-file-13", "mirror-file-14")
def test_a_linear_part_by_roots_is_the_one_by_coefficients(tmp_path):
    path = tmp_path / "roots.toml"
    path.write_text(with_roots(), encoding="utf-8")
    by_roots, by_coefficients = (load_mission(p).mission.mirror.linear for p in (path, PAPER))
    for ours, printed in zip(by_roots.roots, by_coefficients.roots, strict=True):
        size = np.sort(np.abs(ours)), np.sort(np.abs(printed))
        np.testing.assert_allclose(*size, rtol=2e-3)
        assert len(ours) == len(printed)
    freq = np.geomspace(1.0, 5e3, 20)
    responses = [lti.frequency_response(mirror.linear_part(each)[0], freq) for each in (by_roots, by_coefficients)]
    np.testing.assert_allclose(responses[0], responses[1], rtol=5e-3)


@pytest.mark.promise("mirror-file-13", "mirror-file-14", "mirror-file-15")
@pytest.mark.parametrize(
    ("changes", "key", "reason"),
    [
        ([('poles = ["0.0343 Hz", ', "poles = [")], "pole_dampings", "has 4 items where poles has 3"),
        ([("pole_dampings = [1, 1, 1, 0.357]", "pole_dampings = [1, 1, 1, -0.357]")], "pole_dampings", "unstable pole"),
        ([("pole_dampings = [1, 1, 1, 0.357]", "pole_dampings = [1, 1, 1, 0]")], "pole_dampings", "unstable pole"),
        ([("pole_dampings = [1, 1, 1, 0.357]\n", "")], "pole_dampings", "has 0 items where poles has 4"),
        ([("zero_dampings = [1, 1]\n", "")], "zero_dampings", "has 0 items where zeros has 2"),
        ([('zeros = ["0.0672 Hz", "56.64 Hz"]\n', "")], "zero_dampings", "has 2 items where zeros has 0"),
        ([("zeros = [", "denominator = [1]\nzeros = [")], "denominator", "stands beside poles"),
        ([("zero_dampings = [1, 1]", "zero_dampings = [1, 2]")], "zero_dampings", "is above 1"),
        (
            [
                ('zeros = ["0.0672 Hz", "56.64 Hz"]', 'zeros = ["1 Hz", "2 Hz", "3 Hz"]'),
                ("zero_dampings = [1, 1]", "zero_dampings = [0.5, 0.5, -1]"),
            ],
            "zeros",
            "makes 5 zeros over 5 poles",
        ),
        (
            [
                ('zeros = ["0.0672 Hz", "56.64 Hz"]', 'zeros = ["1 Hz", "2 Hz", "3 Hz"]'),
                ("zero_dampings = [1, 1]", "zero_dampings = [0.5, 0.5, 0.5]"),
            ],
            "zeros",
            "makes 6 zeros over 5 poles",
        ),
        ([("zeros = [", "numerator = [1]\nzeros = [")], "numerator", "stands beside poles"),
        ([('poles = ["0.0343 Hz", "54.22 Hz", "1552.7 Hz", "2542.7 Hz"]\n', "")], "zeros", "stands without poles"),
    ],
)
def test_roots_that_do_not_fit_are_told(refuse, changes, key, reason):
    faults = refuse(with_roots(*changes)).faults
    assert any(f.key == f"mirror.linear.{key}" and reason in f.reason for f in faults), faults


def test_a_linear_part_by_roots_may_have_no_zeros_and_one_fewer_than_poles(tmp_path):
    path = tmp_path / "roots.toml"
    for changes, count in (
        ([('zeros = ["0.0672 Hz", "56.64 Hz"]\n', ""), ("zero_dampings = [1, 1]\n", "")], 0),
        ([("zero_dampings = [1, 1]", "zero_dampings = [0.5, -0.5]")], 4),
    ):
        path.write_text(with_roots(*changes), encoding="utf-8")
        zeros, poles = load_mission(path).mission.mirror.linear.roots
        assert (len(zeros), len(poles)) == (count, 5)


@pytest.mark.parametrize(
    ("count", "head", "tail"),
    [
        (1, "1 fault to correct", ""),
        (2, "2 faults to correct", ""),
        (50, "50 f", ""),
        (51, "51 f", "and 1 more"),
        (60, "60 f", "and 10 more"),
    ],
)
def test_fifty_faults_are_shown_and_the_others_counted(count, head, tail):
    """In the order of their lines, those of the file itself first."""
    path = Path("m.toml")
    faults = [
        toml.Fault("key", "", line, f"is wrong on {line}", "another", file="m.toml") for line in range(count, 1, -1)
    ]
    faults.append(toml.Fault("key", "", 1, "is wrong elsewhere", "another", file="a.toml"))
    error = MissionError(path, faults)
    text = str(error)
    assert text.startswith(f"m.toml: {head}")
    assert [fault.line for fault in error.faults] == [*range(2, count + 1), 1]
    assert text.count("is wrong") == min(count, 50)
    assert text.splitlines()[-1] == tail if tail else "more" not in text


def test_faults_stand_by_file_and_line_those_of_the_file_itself_first():
    places = [("z.toml", 1), ("a.toml", 9), ("m.toml", 8), ("a.toml", 2), ("m.toml", 7)]
    error = MissionError(Path("m.toml"), [toml.Fault("", "", line, "", "", file=name) for name, line in places])
    assert [(fault.file, fault.line) for fault in error.faults] == [places[k] for k in (4, 2, 3, 1, 0)]


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({}, None),
        ({"depth": toml._MAX_DEPTH}, None),
        ({"depth": toml._MAX_DEPTH + 1}, f"is nested {toml._MAX_DEPTH + 1} brackets deep"),
        ({"key": "k" * toml._MAX_KEY}, None),
        ({"key": "k" * (toml._MAX_KEY + 1)}, f"is a key of {toml._MAX_KEY + 1} characters"),
        ({"value": "1" * toml._MAX_NUMBER}, None),
        ({"value": "1" * (toml._MAX_NUMBER + 1)}, f"is a number of {toml._MAX_NUMBER + 1} characters"),
        ({"value": "-" + "1" * toml._MAX_NUMBER}, f"is a number of {toml._MAX_NUMBER + 1} characters"),
        ({"value": '"' + "1" * toml._MAX_NUMBER + '"'}, None),
    ],
)
def test_a_statement_is_too_large_beyond_its_limits_and_not_at_them(changes, reason):
    statement = replace(toml.Statement("key", "key", 1, 1, "1"), **changes)
    found = toml._oversize(statement)
    assert (None if found is None else found[0]) == reason


BAND = {"excited_from_hz": 2.0, "normalise_at_hz": 3.0, "excited_to_hz": 4500.0}


def refused(call, *given):
    """The problems that a call raises."""
    with pytest.raises(ProblemsError) as error:
        call(*given)
    return error.value.problems


def known():
    """A mirror with three tables that parameters stand in."""
    linear = made(
        LinearPart, poles_hz=(500.0, 900.0, 1e3), pole_dampings=(0.5, 1.0, 0.25), zeros_hz=(0.0,), zero_dampings=(-1.0,)
    )
    plays = made(PrandtlIshlinskiiTable, thresholds_v=(0.0, 1.0), weights_rad_v=(1e-3, 2e-3), widening_s=0.0)
    creep = made(CreepTable, time_constants_s=(1.0, 3.0), weights_rad_v=(1e-4, 0.0))
    return made(Mirror, linear=linear, prandtl_ishlinskii=plays, creep=creep)


ALL_OF_A_MIRROR = {
    "an amplifier that falls": (
        lambda: made(Amplifier, output_min_v=-2.5, output_max_v=-2.5).problems(),
        """output_max is not above output_min (-2.5 V): expected a voltage above -2.5 V""",
    ),
    "a clock of the control": (
        lambda: made(Control, rate_hz=4000.0, delay_s=33e-6, plant_step_s=10e-6).problems(),
        """delay is no whole number of plant_step: expected delay = "30 µs" would do""",
    ),
    "a bias out of an amplifiers reach": (
        lambda: _bias_fits(
            SimpleNamespace(bias_v=61.0), SimpleNamespace(output_min_v=-30.0, output_max_v=150.0, gain=2.5)
        ),
        """
        mirror.bias is outside amplifier.output_min to amplifier.output_max divided by amplifier.gain: expected -12
        V to 60 V
        """,
    ),
    "a bias out of a reach that is no round number": (
        lambda: _bias_fits(
            SimpleNamespace(bias_v=70.0), SimpleNamespace(output_min_v=-100.0, output_max_v=200.0, gain=3.0)
        ),
        """
        mirror.bias is outside amplifier.output_min to amplifier.output_max divided by amplifier.gain: expected -33.33
        V to 66.66 V
        """,
    ),
    "sines too slow and too fast for a rate of many digits": (
        lambda: _frequencies_fit(
            SimpleNamespace(rate_hz=20468.6),
            SimpleNamespace(
                pid_frequencies_hz=(0.01, 3.0), inverse_frequencies_hz=(1.0, 12e3), loop_frequencies_hz=(1.0, 2.0)
            ),
        ),
        """
        scenario.pid_frequencies begins at 10 mHz, a period of over 2000000 control samples: expected frequencies of at
        least 10.24 mHz; scenario.inverse_frequencies reaches 12 kHz, but half of control.rate is 10.23 kHz: expected
        frequencies below 10.23 kHz
        """,
    ),
    "sines too slow and too fast": (
        lambda: _frequencies_fit(
            SimpleNamespace(rate_hz=2e4),
            SimpleNamespace(
                pid_frequencies_hz=(1e-9, 3.0), inverse_frequencies_hz=(1.0, 10000.0), loop_frequencies_hz=(2e-9, 12e3)
            ),
        ),
        """
        scenario.pid_frequencies begins at 1e-06 mHz, a period of over 2000000 control samples: expected frequencies
        of at least 10 mHz; scenario.inverse_frequencies reaches 10 kHz, but half of control.rate is 10 kHz:
        expected frequencies below 10 kHz; scenario.loop_frequencies begins at 2e-06 mHz, a period of over 2000000
        control samples: expected frequencies of at least 10 mHz; scenario.loop_frequencies reaches 12 kHz, but half
        of control.rate is 10 kHz: expected frequencies below 10 kHz
        """,
    ),
    "coefficients with what roots have, of an integrator": (
        lambda: made(
            LinearPart,
            numerator=(0.0, 0.0),
            denominator=(0.0, 2.0, 0.0),
            zeros_hz=(1.0,),
            pole_dampings=(1.0,),
            zero_dampings=(),
            excited_from_hz=5.0,
            excited_to_hz=5.0,
        ).problems(),
        """
        zeros stands without poles: expected the key poles, or this one removed: poles = ["5 kHz"]; pole_dampings
        stands without poles: expected the key poles, or this one removed: poles = ["5 kHz"]; zero_dampings stands
        without poles: expected the key poles, or this one removed: poles = ["5 kHz"]; denominator ends with 0,
        which makes the linear part an integrator: expected a last coefficient other than 0; model drift apart from
        the mirror; denominator begins with 0: expected the highest power of s first, with a factor other than 0;
        numerator is zero throughout: expected at least one coefficient other than 0; excited_to is not above
        excited_from: expected a band that goes up
        """,
    ),
    "a band of five digits, told with all of them": (
        lambda: made(
            LinearPart,
            numerator=(1.0,),
            denominator=(1.0, 1.0),
            excited_from_hz=2.0004,
            normalise_at_hz=1.0,
            excited_to_hz=4500.4,
        ).problems(),
        """
        normalise_at is outside excited_from to excited_to (2.0004 Hz to 4.5004 kHz): expected 2.0004 Hz to 4.5004 kHz
        """,
    ),
    "coefficients of as high an order above": (
        lambda: made(
            LinearPart,
            numerator=(0.0, 1.0, 2.0, 3.0),
            denominator=(1.0, 2.0, 3.0),
            excited_from_hz=2.0,
            normalise_at_hz=4501.0,
            excited_to_hz=4500.0,
        ).problems(),
        """
        numerator has no lower order than denominator: expected fewer coefficients than denominator has;
        normalise_at is outside excited_from to excited_to (2 Hz to 4.5 kHz): expected 2 Hz to 4.5 kHz
        """,
    ),
    "a factor that is nothing": (
        lambda: made(LinearPart, numerator=(2.0,), denominator=(-1.5e-148, -7.5e2, 1.0), **BAND).problems(),
        """
        denominator begins with a factor that is nothing beside others: -1.5e-148 of 750: expected coefficients of
        at most 1e+150 times the first one
        """,
    ),
    "no numerator": (
        lambda: made(LinearPart, denominator=(1.0, 1.0), **BAND).problems(),
        """has no numerator: expected poles and pole_dampings, or numerator and denominator""",
    ),
    "neither form": (
        lambda: made(LinearPart, numerator=(1.0, 1.0), **BAND).problems(),
        """
        has neither poles nor numerator and denominator: expected poles and pole_dampings, or numerator and
        denominator
        """,
    ),
    "roots beside coefficients, unstable and too many": (
        lambda: made(
            LinearPart,
            numerator=(1.0,),
            denominator=(1.0,),
            poles_hz=(1.0, 2.0, 3.0),
            pole_dampings=(0.5, 0.0),
            zeros_hz=(1.0, 2.0),
            zero_dampings=(-1.0, 0.5, 1.0),
            **BAND,
        ).problems(),
        """
        numerator stands beside poles: expected the transfer function in one form only; denominator stands beside
        poles: expected the transfer function in one form only; pole_dampings has 2 items where poles has 3:
        expected one damping for each of poles; zero_dampings has 3 items where zeros has 2: expected one damping
        for each of zeros; pole_dampings has an unstable pole: expected dampings above 0; zeros makes 4 zeros over 4
        poles: expected fewer zeros than poles, pairs counted twice
        """,
    ),
    "the asymmetry of both kinds": (
        lambda: made(BoucWenTable, alpha_1_v=1.125, beta_1_v=-0.75, gamma_1_v=0.5, eta_1_v=0.125).problems(),
        """
        alpha is not above the size of what beta, gamma and eta take off it (1.375 1/V), so h would grow without
        bound: expected above 1.375 1/V
        """,
    ),
    "the size of beta": (
        lambda: made(BoucWenTable, alpha_1_v=0.75, beta_1_v=-0.75, gamma_1_v=0.0, eta_1_v=0.0).problems(),
        """
        alpha is not above the size of beta (0.75 1/V), so h would grow without bound: expected above 0.75 1/V
        """,
    ),
    "plays without a first one, of no weight": (
        lambda: made(PrandtlIshlinskiiTable, thresholds_v=(0.5, 1.0), weights_rad_v=(0.0, 0.0, 0.0)).problems(),
        """
        thresholds does not begin at 0 V: expected a first threshold of "0 V"; weights has 3 items where thresholds
        has 2: expected one weight for each threshold; weights is zero throughout: expected at least one weight
        above 0
        """,
    ),
    "creep of one weight": (
        lambda: made(CreepTable, time_constants_s=(0.5, 1.0, 2.0), weights_rad_v=(1e-6,)).problems(),
        """weights has 1 item where time_constants has 3: expected one weight for each time constant""",
    ),
    "a comparison with two models": (
        lambda: made(Comparison, bouc_wen=0, prandtl_ishlinskii=0).problems(),
        """has two hysteresis models: expected exactly one of the tables bouc_wen and prandtl_ishlinskii""",
    ),
    "an uncertainty that counts otherwise": (
        lambda: made(
            Uncertainty, parameters=("a", "b", "c"), standard_errors=(0.1, 0.2), correlation=(0.5, 0.25)
        ).problems(),
        """
        standard_errors has 2 items where parameters has 3: expected one standard error for each parameter;
        correlation has 2 items where 3 parameters have 3 pairs: expected 3 numbers, the lower triangle without the
        diagonal, or none
        """,
    ),
    "correlations that cannot be": (
        lambda: made(
            Uncertainty, parameters=("a", "b", "c"), standard_errors=(0.1, 0.2, 0.3), correlation=(0.875, 0.75, -0.5)
        ).problems(),
        """
        correlation is not positive semidefinite: its smallest eigenvalue is -0.428: expected correlations that can
        be together, as the fit gave them
        """,
    ),
    "keys that are no text": (
        lambda: refused(KeyList(None).read, ["a", 2]),
        """
        is not a list of keys in quotes: expected a list of keys inside the mirror, items of lists counted from 1:
        ["bouc_wen.d1", "linear.poles.1"]
        """,
    ),
    "more keys than there may be": (
        lambda: refused(KeyList(None, most=2).read, ["a", "b", "c"]),
        """is a list of 3 items: expected at most 2 items""",
    ),
    "a table that is not there": (
        lambda: refused(place, known(), "bouc_wen.d1"),
        """
        uncertainty.parameters has "bouc_wen.d1", which is in no table of this mirror: expected a key of linear,
        prandtl_ishlinskii, creep
        """,
    ),
    "a key of another form": (
        lambda: refused(place, known(), "linear.numerator"),
        """
        uncertainty.parameters has "linear.numerator", which is no parameter of this mirror's linear: expected one
        of poles, pole_dampings, zeros, zero_dampings
        """,
    ),
    "a value of nothing": (
        lambda: refused(place, known(), "prandtl_ishlinskii.widening"),
        """
        uncertainty.parameters has "prandtl_ishlinskii.widening", which is 0 in this mirror, and nothing is relative
        to 0: expected a parameter that is not held at 0
        """,
    ),
    "an item of nothing": (
        lambda: refused(place, known(), "creep.weights.2"),
        """
        uncertainty.parameters has "creep.weights.2", which is 0 in this mirror, and nothing is relative to 0:
        expected a parameter that is not held at 0
        """,
    ),
    "an item of a single value": (
        lambda: refused(place, known(), "prandtl_ishlinskii.widening.1"),
        """
        uncertainty.parameters has "prandtl_ishlinskii.widening.1", which counts the items of a single value:
        expected the key without a number
        """,
    ),
    "an item beyond the list": (
        lambda: refused(place, known(), "linear.poles.4"),
        """
        uncertainty.parameters has "linear.poles.4", which names no item of a list of 3: expected a number from 1 to
        3
        """,
    ),
    "the damping of a real pole": (
        lambda: refused(place, known(), "linear.pole_dampings.2"),
        """
        uncertainty.parameters has "linear.pole_dampings.2", which is the damping of a real root, 1 by definition:
        expected the damping of a pair of roots
        """,
    ),
    "the dampings of all poles, one of them real": (
        lambda: refused(place, known(), "linear.pole_dampings"),
        """
        uncertainty.parameters has "linear.pole_dampings", which is the damping of a real root, 1 by definition:
        expected the damping of a pair of roots
        """,
    ),
    "the dampings of all zeros": (
        lambda: refused(place, known(), "linear.zero_dampings"),
        """
        uncertainty.parameters has "linear.zero_dampings", which is the damping of a real root, 1 by definition:
        expected the damping of a pair of roots
        """,
    ),
    "values named twice": (
        lambda: mirror_table._uncertainty_problems(
            known(),
            SimpleNamespace(
                parameters=(
                    "linear.poles.1",
                    "linear.poles.3",
                    "linear.poles.1",
                    "creep.weights",
                    "creep.weights.1",
                    "creep.time_constants.2",
                    "creep.time_constants",
                    "x",
                )
            ),
        ),
        """
        uncertainty.parameters has "linear.poles.1", which stands twice, or beside its whole list: expected each
        value once; uncertainty.parameters has "creep.weights.1", which stands twice, or beside its whole list:
        expected each value once; uncertainty.parameters has "creep.time_constants", which stands twice, or beside
        its whole list: expected each value once; uncertainty.parameters has "x", which is in no table of this
        mirror: expected a key of linear, prandtl_ishlinskii, creep
        """,
    ),
    "a mirror of no model and no range": (
        lambda: made(Mirror, composition="additive", bias_v=1.0, drive_min_v=12.5, drive_max_v=12.5).problems(),
        """
        has no hysteresis model: expected exactly one of the tables bouc_wen and prandtl_ishlinskii; drive_max is
        not above drive_min (12.5 V): expected a voltage above 12.5 V; composition is "additive" but the table
        linear is missing: expected a table linear, or composition = "static"
        """,
    ),
    "a still mirror with dynamics, its bias out of range": (
        lambda: made(
            Mirror, composition="static", linear=0, bouc_wen=0, bias_v=13.0, drive_min_v=-2.5, drive_max_v=12.5
        ).problems(),
        """
        bias is outside drive_min to drive_max (-2.5 V to 12.5 V): expected -2.5 V to 12.5 V; linear does not belong
        to composition = "static": expected the table linear removed, or composition = "cascade"
        """,
    ),
}


@pytest.mark.parametrize("what", ALL_OF_A_MIRROR)
def test_all_that_does_not_fit_in_a_table_of_the_mirror_is_told_in_full(what):
    problems, words = ALL_OF_A_MIRROR[what]
    assert told(problems()) == one_line(words)


def answered(call, *given, **named):
    """What a call gives, or the error that it raises, in words."""
    try:
        return repr(call(*given, **named))
    except ValueError as error:
        return f"{type(error).__name__}: {error}"


@dataclass(frozen=True, slots=True)
class Held(Bounded):
    """A record of three bounded numbers, one of them with a reason."""

    name: str = ""
    length_m: Annotated[float, Quantity("m", above=0.0, most=2e3), "the bench is no longer"] = 1.0
    angle_rad: Annotated[float, Quantity("rad", "deg", least=-0.5, most=0.5)] = 0.25
    share: Annotated[float, Share("", least=1e-3, below=0.5)] = 0.125


ANGLE = Quantity("rad", "deg", above=-0.25, most=1.5)
MASS = Quantity("kg", least=2.5, most=40.0)
PLAIN = Quantity("", above=0.0, most=40.0)
COUNT = Whole("", least=5, most=40)


ALL_OF_A_RULE = {
    "an angle": (
        lambda: answered(ANGLE.read, "-0.125 rad"),
        "-0.125",
    ),
    "an angle at its bound": (
        lambda: answered(ANGLE.read, "-0.25 rad"),
        """
        UnitError: "-0.25 rad" is not above -14.32 deg; expected an angle with its unit, above -14.32 deg, at most
        85.94 deg, for example "5 deg"
        """,
    ),
    "an angle beyond": (
        lambda: answered(ANGLE.read, "90 deg"),
        """
        UnitError: "90 deg" is above 85.94 deg; expected an angle with its unit, above -14.32 deg, at most 85.94
        deg, for example "5 deg"
        """,
    ),
    "a plain angle": (
        lambda: answered(ANGLE.read, 7),
        """
        UnitError: 7 is a number without a unit; expected an angle with its unit, for example "7 deg"
        """,
    ),
    "an unknown angle": (
        lambda: answered(ANGLE.read, "unknown"),
        """
        UnitError: "unknown" is in no source that the preset names, and has to be given; expected an angle with its
        unit, above -14.32 deg, at most 85.94 deg, for example "5 deg"
        """,
    ),
    "a mass": (
        lambda: answered(MASS.read, "2500 g"),
        "2.5",
    ),
    "a mass that is a time": (
        lambda: answered(MASS.read, "3 s"),
        """
        UnitError: "3 s" is in "s", another kind of quantity; expected a mass with its unit, for example "5 kg"
        """,
    ),
    "a small mass": (
        lambda: answered(MASS.read, "2.4999 kg"),
        """
        UnitError: "2.4999 kg" is below 2.5 kg; expected a mass with its unit, at least 2.5 kg, at most 40 kg, for
        example "5 kg"
        """,
    ),
    "a large mass": (
        lambda: answered(MASS.read, "40.001 kg"),
        """
        UnitError: "40.001 kg" is above 40 kg; expected a mass with its unit, at least 2.5 kg, at most 40 kg, for
        example "5 kg"
        """,
    ),
    "a plain number": (
        lambda: answered(PLAIN.read, 40),
        "40.0",
    ),
    "a plain number beyond": (
        lambda: answered(PLAIN.read, 40.5),
        """
        UnitError: 40.5 is above 40; expected a number without quotes, above 0, at most 40, for example "5.0"
        """,
    ),
    "a plain nothing": (
        lambda: answered(PLAIN.read, 0),
        """
        UnitError: 0 is not above 0; expected a number without quotes, above 0, at most 40, for example "5.0"
        """,
    ),
    "a text for a number": (
        lambda: answered(PLAIN.read, "4"),
        """
        UnitError: "4" is not a plain number; expected a number without quotes, for example "1.0"
        """,
    ),
    "a switch for a number": (
        lambda: answered(PLAIN.read, True),
        """
        UnitError: a value of type bool is not a plain number; expected a number without quotes, for example "1.0"
        """,
    ),
    "no number": (
        lambda: answered(PLAIN.read, math.nan),
        """
        UnitError: nan is not a finite number; expected a finite number, for example "1.0"
        """,
    ),
    "a number without end": (
        lambda: answered(PLAIN.read, -math.inf),
        """
        UnitError: -inf is not a finite number; expected a finite number, for example "1.0"
        """,
    ),
    "a number of 400 digits": (
        lambda: answered(PLAIN.read, 10**400),
        """
        UnitError: a value of type int is not a finite number; expected a finite number, for example "1.0"
        """,
    ),
    "a number beyond all": (
        lambda: answered(PLAIN.read, -1.5e100),
        """
        UnitError: -1.5e+100 is beyond 1e+100; expected a number of a mission, or of a mirror, for example "1.0"
        """,
    ),
    "an unknown number": (
        lambda: answered(PLAIN.read, "unknown"),
        """
        UnitError: "unknown" is in no source that the preset names, and has to be given; expected a number without
        quotes, above 0, at most 40, for example "5.0"
        """,
    ),
    "a count": (
        lambda: answered(COUNT.read, 40),
        "40",
    ),
    "a count below": (
        lambda: answered(COUNT.read, 4),
        """
        UnitError: 4 is below 5; expected a whole number without quotes, from 5 to 40, for example "5"
        """,
    ),
    "a count beyond": (
        lambda: answered(COUNT.read, 41),
        """
        UnitError: 41 is above 40; expected a whole number without quotes, from 5 to 40, for example "5"
        """,
    ),
    "a count of halves": (
        lambda: answered(COUNT.read, 7.0),
        """
        UnitError: 7 is not a whole number; expected a whole number without quotes, from 5 to 40, for example "5"
        """,
    ),
    "a switch for a count": (
        lambda: answered(COUNT.read, True),
        """
        UnitError: a value of type bool is not a whole number; expected a whole number without quotes, from 5 to 40,
        for example "5"
        """,
    ),
    "an unknown count": (
        lambda: answered(COUNT.read, "unknown"),
        """
        UnitError: "unknown" is in no source that the preset names, and has to be given; expected a whole number
        without quotes, from 5 to 40, for example "5"
        """,
    ),
    "a share": (
        lambda: answered(Share("", below=0.5).read, 0.4375),
        "0.4375",
    ),
    "a share at its end": (
        lambda: answered(Share("", below=0.5).read, 0.5),
        """
        UnitError: 0.5 is not above 0 and below 0.5; expected a number without quotes, above 0 and below 0.5, for
        example "0.25"
        """,
    ),
    "a share of nothing": (
        lambda: answered(Share("", below=0.5).read, 0.0),
        """
        UnitError: 0 is not above 0 and below 0.5; expected a number without quotes, above 0 and below 0.5, for
        example "0.25"
        """,
    ),
    "a share at its least": (
        lambda: answered(Share("", least=1e-6, below=0.25).read, 1e-6),
        "1e-06",
    ),
    "a share below its least": (
        lambda: answered(Share("", least=1e-6, below=0.25).read, 9e-7),
        """
        UnitError: 9e-07 is below 1e-06; expected a number without quotes, at least 1e-06 and below 0.25, for
        example "0.001"
        """,
    ),
    "a share beyond": (
        lambda: answered(Share("", least=1e-6, below=0.25).read, 0.25),
        """
        UnitError: 0.25 is not above 0 and below 0.25; expected a number without quotes, at least 1e-06 and below
        0.25, for example "0.001"
        """,
    ),
    "a switch": (
        lambda: answered(Switch("").read, False),
        "False",
    ),
    "a one for a switch": (
        lambda: answered(Switch("").read, 1),
        """
        UnitError: 1 is neither true nor false; expected true or false, without quotes, for example "true"
        """,
    ),
    "an unknown switch": (
        lambda: answered(Switch("").read, "unknown"),
        """
        UnitError: "unknown" is in no source that the preset names, and has to be given; expected true or false,
        without quotes, for example "true"
        """,
    ),
    "a word": (
        lambda: answered(
            OrWord("m", "cm", above=0.0, most=3.0, word="best", meaning=" of all", stands_for=-2.0).read, "best"
        ),
        "-2.0",
    ),
    "another word": (
        lambda: answered(OrWord("m", "cm", above=0.0, most=3.0, word="best", meaning=" of all").read, "worst"),
        """
        UnitError: "worst" does not begin with a plain number; expected a length with its unit, above 0 m, at most 3
        m, or "best" of all, for example "5 cm"
        """,
    ),
    "a length beside a word": (
        lambda: answered(OrWord("m", "cm", above=0.0, most=3.0, word="best").read, "250 cm"),
        "2.5",
    ),
    "a length too long beside a word": (
        lambda: answered(OrWord("m", "cm", above=0.0, most=3.0, word="best", meaning=" of all").read, "301 cm"),
        """
        UnitError: "301 cm" is above 3 m; expected a length with its unit, above 0 m, at most 3 m, or "best" of all,
        for example "5 cm"
        """,
    ),
    "a list": (
        lambda: answered(Several(MASS, rising=True).read, ["3 kg", "4000 g"]),
        "(3.0, 4.0)",
    ),
    "a list that falls": (
        lambda: answered(Several(MASS, rising=True).read, ["4 kg", "4000 g", "5 kg"]),
        """
        ProblemsError: does not rise from item to item: expected a list, rising, each item a mass with its unit, at
        least 2.5 kg, at most 40 kg
        """,
    ),
    "a list of two that are wrong": (
        lambda: answered(Several(MASS).read, ["1 kg", "3 kg", 4]),
        """
        ProblemsError: item 1: "1 kg" is below 2.5 kg; expected a mass with its unit, at least 2.5 kg, at most 40
        kg, for example "5 kg": expected a list, each item a mass with its unit, at least 2.5 kg, at most 40 kg;
        item 3: 4 is a number without a unit; expected a mass with its unit, for example "4 kg": expected a list,
        each item a mass with its unit, at least 2.5 kg, at most 40 kg
        """,
    ),
    "no list": (
        lambda: answered(Several(MASS).read, "3 kg"),
        """
        ProblemsError: is not a list with something in it: expected a list, each item a mass with its unit, at least
        2.5 kg, at most 40 kg
        """,
    ),
    "an empty list": (
        lambda: answered(Several(PLAIN, rising=True).read, []),
        """
        ProblemsError: is not a list with something in it: expected a list, rising, each item a number without
        quotes, above 0, at most 40
        """,
    ),
    "a list of many": (
        lambda: answered(Several(PLAIN, most=2).read, [1, 2, 3]),
        "ProblemsError: is a list of 3 items: expected at most 2 items",
    ),
    "an unknown list": (
        lambda: answered(Several(PLAIN).read, "unknown"),
        """
        ProblemsError: is in no source that the preset names, and has to be given: expected a list, each item a
        number without quotes, above 0, at most 40
        """,
    ),
    "a month for all": (
        lambda: answered(Monthly(PLAIN).read, 2.5),
        "(2.5,)",
    ),
    "a wrong month for all": (
        lambda: answered(Monthly(PLAIN).read, -2.5),
        """
        UnitError: -2.5 is not above 0; expected a number without quotes, above 0, at most 40, or a list of 12 such,
        January to December, for example "5.0"
        """,
    ),
    "eleven months": (
        lambda: answered(Monthly(PLAIN).read, [1.0] * 11),
        """
        ProblemsError: is a list of 11, and a year has 12 months: expected a number without quotes, above 0, at most
        40, or a list of 12 such, January to December
        """,
    ),
    "twelve months": (
        lambda: answered(Monthly(PLAIN).read, list(range(1, 13))),
        "(1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0, 10.0, 11.0, 12.0)",
    ),
    "twelve months, two of them wrong": (
        lambda: answered(Monthly(PLAIN).read, [41, *range(1, 11), "12"]),
        """
        ProblemsError: item 1: 41 is above 40; expected a number without quotes, above 0, at most 40, for example
        "5.0": expected a number without quotes, above 0, at most 40, or a list of 12 such, January to December;
        item 12: "12" is not a plain number; expected a number without quotes, for example "1.0": expected a number
        without quotes, above 0, at most 40, or a list of 12 such, January to December
        """,
    ),
    "an epoch": (
        lambda: answered(UtcEpoch("").read, "2028-02-29T23:59:59.25Z"),
        "'2028-02-29T23:59:59.25Z'",
    ),
    "a date without its zone": (
        lambda: answered(UtcEpoch("").read, "2026-02-28T12:00:00"),
        """
        UnitError: "2026-02-28T12:00:00" is not a date and time with a Z for UTC; expected a date and time in UTC,
        for example "2026-03-20T12:00:00Z"
        """,
    ),
    "a number for a date": (
        lambda: answered(UtcEpoch("").read, 20260228),
        """
        UnitError: "20260228" is not a date and time with a Z for UTC; expected a date and time in UTC, for example
        "2026-03-20T12:00:00Z"
        """,
    ),
    "a record in its bounds": (
        lambda: answered(Held, name="a", length_m=2e3, angle_rad=-0.5, share=1e-3),
        "Held(name='a', length_m=2000.0, angle_rad=-0.5, share=0.001)",
    ),
    "a record too long": (
        lambda: answered(Held, length_m=2000.5),
        """
        ValueError: Held.length_m is 2.001 km: it must be finite, above 0 m, at most 2 km; the bench is no longer
        """,
    ),
    "a named record that is turned too far": (
        lambda: answered(Held, name="bench 2", angle_rad=-0.625),
        """
        ValueError: Held.angle_rad of bench 2 is -35.81 deg: it must be finite, at least -28.65 deg, at most 28.65
        deg
        """,
    ),
    "a record of no end": (
        lambda: answered(Held, name="x", share=math.inf),
        "ValueError: Held.share of x is inf: it must be finite, at least 0.001 and below 0.5",
    ),
    "a record of no share": (
        lambda: answered(Held, share=0.5),
        "ValueError: Held.share is 0.5: it must be finite, at least 0.001 and below 0.5",
    ),
    "a choice of words for an editor": (
        lambda: OrWord("m", "cm", above=0.0, word="best").__get_pydantic_json_schema__(None, None)["anyOf"][1:],
        "[{'const': 'best'}]",
    ),
    "a number for an editor": (
        lambda: Quantity("", above=0.5, most=4.0).__get_pydantic_json_schema__(None, None),
        "{'type': 'number', 'exclusiveMinimum': 0.5, 'maximum': 4.0}",
    ),
    "an angle for an editor": (
        lambda: {k: v for k, v in ANGLE.__get_pydantic_json_schema__(None, None).items() if k != "pattern"},
        "{'type': 'string', 'x-si-unit': 'rad', 'examples': ['5 deg']}",
    ),
    "a share for an editor": (
        lambda: Share("", least=0.125, below=0.5).__get_pydantic_json_schema__(None, None),
        "{'type': 'number', 'minimum': 0.125, 'exclusiveMaximum': 0.5}",
    ),
    "a share of anything for an editor": (
        lambda: Share("", below=0.25).__get_pydantic_json_schema__(None, None),
        "{'type': 'number', 'exclusiveMinimum': 0.0, 'exclusiveMaximum': 0.25}",
    ),
    "a count for an editor": (
        lambda: COUNT.__get_pydantic_json_schema__(None, None),
        "{'type': 'integer', 'minimum': 5, 'maximum': 40}",
    ),
    "a list for an editor": (
        lambda: Several(PLAIN).__get_pydantic_json_schema__(None, None),
        """
        {'type': 'array', 'minItems': 1, 'items': {'type': 'number', 'exclusiveMinimum': 0.0, 'maximum': 40.0}}
        """,
    ),
    "months for an editor": (
        lambda: Monthly(PLAIN).__get_pydantic_json_schema__(None, None),
        """
        {'anyOf': [{'type': 'number', 'exclusiveMinimum': 0.0, 'maximum': 40.0}, {'type': 'array', 'minItems': 12,
        'maxItems': 12, 'items': {'type': 'number', 'exclusiveMinimum': 0.0, 'maximum': 40.0}}]}
        """,
    ),
}


@pytest.mark.parametrize("what", ALL_OF_A_RULE)
def test_what_a_rule_reads_and_what_it_says_of_what_it_does_not_read(what):
    call, words = ALL_OF_A_RULE[what]
    assert one_line(str(call())) == one_line(words)


def said(text):
    """Every statement of a text with all that it says of it, one a line."""
    return "; ".join(
        f"{s.kind} {s.key} {s.line}-{s.last_line} {s.value!r} {s.comment!r} {s.depth} {s.closed} {s.place}"
        for s in scan(text)
    )


def read_as(content, **how):
    """The faults of a text as a file of these keys, or what is read of it."""
    how = {"names": None, "prefix": "", "most_bytes": 300} | how
    try:
        document = Document.of(content, Path("m.toml"), "mission file", how["prefix"], how["names"], how["most_bytes"])
    except UnreadableError as error:
        return f"unreadable: {error}"
    except MissionError as error:
        return str(error)
    faults = re.sub("is not TOML: .*", "is not TOML", "; ".join(map(str, document.faults)))  # whose words are Python's
    return f"{document.data} {sorted(document.damaged)} {faults}"


ALL_OF_A_TEXT = {
    "tables and lists of tables and keys in them": (
        lambda: said(
            'a = 1\n[b.c] # h\nd."e f" = [ # 1\n  2, # 2\n  3\n] # 3\n[[g]]\nh = "x # y"\n[[g]]\nh = {i = [1]}\n'
        ),
        r"""
        key a 1-1 '1' '' 0 True 4; table b.c 2-2 '' '' 0 True 0; key b.c.d.e f 3-6 '[ # 1\n 2, # 2\n 3\n]' '3' 1
        True 26; tables g 7-7 '' '' 0 True 0; key g#7.h 8-8 '"x # y"' '' 0 True 61; tables g 9-9 '' '' 0 True 0; key
        g#9.h 10-10 '{i = [1]}' '' 2 True 79
        """,
    ),
    "a list that is not closed": (
        lambda: said("a = [1,\n 2\nb = 3\n[c\nd = 4\nwords\n e = 5"),
        r"""
        key a 1-2 '[1,\n 2' '' 1 False 4; key b 3-3 '3' '' 0 True 15; broken c 4-4 '[c' '' 0 True 0; key c.d 5-5 '4'
        '' 0 True 24; junk 6-6 'words' '' 0 True 0; key c.e 7-7 '5' '' 0 True 37
        """,
    ),
    "texts of several lines": (
        lambda: said('a = """x\n[b]\ny""" # z\n\nb = \'c # d\' # e\n'),
        r'''key a 1-3 '"""x\n[b]\ny"""' 'z' 0 True 4; key b 5-5 "'c # d'" 'e' 0 True 27''',
    ),
    "a key twice, and a table": (
        lambda: read_as(b"a = 1\nb = 2\na = 3\n[c]\nd = 4\n[c]\ne = 5\n"),
        """
        {'a': 1, 'b': 2, 'c': {'d': 4}} ['a', 'c'] m.toml, line 3: a = 3 this key stands twice, on lines 1 and 3
        expected: one of the two removed; m.toml, line 6: c this table stands twice, on lines 4 and 6 expected: one
        of the two removed
        """,
    ),
    "a header that is none, and words": (
        lambda: read_as(b"a = 1\n[b\nc = 2\nwords here\n[d]\ne = 3\n"),
        "{'a': 1, 'd': {'e': 3}} ['b'] m.toml, line 2: [b is no table header expected: [b]",
    ),
    "a value without quotes, and one that is missing": (
        lambda: read_as(b'a = 5 W\nb =\nc = "d\n'),
        """
        {} ['a', 'b', 'c'] m.toml, line 1: a = 5 W is not TOML expected: text in quotes: a = "5 W"; m.toml, line 2:
        b has no value expected: b = "value"; m.toml, line 3: c = "d is not TOML expected: quotes and brackets
        closed, and one key = value on a line
        """,
    ),
    "a value that is too deep": (
        lambda: read_as(b"a = " + b"[" * 17 + b"]" * 17 + b"\nb = [" + b"[" * 15 + b"]" * 15 + b"]"),
        """
        {'b': [[[[[[[[[[[[[[[[]]]]]]]]]]]]]]]]} ['a'] m.toml, line 1: a = [[[[[[[[[[[[[[[[[]]]]]]]]]]]]]]]]] is
        nested 17 brackets deep expected: a value, or a list of values
        """,
    ),
    "a number that is too long": (
        lambda: read_as(b"a = 1" + b"0" * 400 + b"\nb = -1" + b"0" * 20, most_bytes=2000),
        """
        {'b': -100000000000000000000} ['a'] m.toml, line 1: a =
        100000000000000000000000000000000000000000000000000000000000… is a number of 401 characters expected: a
        number of at most 17 digits
        """,
    ),
    "a key of another file": (
        lambda: read_as(b"[mirror]\nx = 1 2\nname = 3 4\n[other", names={"name"}, prefix="mirror"),
        """
        {'mirror': {}} ['mirror.mirror.name', 'mirror.mirror.x', 'mirror.other'] m.toml, line 4 is no table header
        expected: key = "value", [table] or # comment; m.toml, line 2 is not TOML expected: key = "value", [table]
        or # comment; m.toml, line 3: mirror.mirror.name = 3 4 is not TOML expected: text in quotes: name = "3 4"
        """,
    ),
    "a name that cannot be printed": (
        lambda: read_as(b'"a\\u0007b" = 1\n[[c]]\n"d\\u200be" = 2\n'),
        r"""
        {'a\x07b': 1, 'c': [{'d\u200be': 2}]} [] m.toml: a\u0007b has the name "a\u0007b", with characters that
        cannot be printed expected: a name of letters, digits and signs; m.toml, line 2: c.d\u200be has the name
        "d\u200be", with characters that cannot be printed expected: a name of letters, digits and signs
        """,
    ),
    "binary data": (
        lambda: read_as(b"a\0b"),
        "unreadable: holds binary data; expected a TOML file, plain text in UTF-8",
    ),
    "a text in another code": (
        lambda: read_as(b"a = 1\n\nb = '\xff'"),
        "unreadable: is not UTF-8 text (line 3); expected the file saved again as UTF-8",
    ),
    "nothing but blanks": (
        lambda: read_as(b" \n \n"),
        "unreadable: is empty; expected a TOML file; `microrad init` writes one to start from",
    ),
    "too much": (
        lambda: read_as(b"a" * 301),
        "unreadable: is larger than 0 kB; expected a TOML file of a few kB",
    ),
    "too much by kilobytes": (
        lambda: read_as(b"a" * 2400, most_bytes=2399),
        "unreadable: is larger than 2 kB; expected a TOML file of a few kB",
    ),
    "too many lines": (
        lambda: read_as(b"\n" * 10_001, most_bytes=20_000),
        "unreadable: has more than 10000 lines; expected a TOML file of a few hundred lines",
    ),
    "a mark at its begin, and line ends of another system": (
        lambda: read_as(b"\xef\xbb\xbfa = 1\r\nb = 2\r\n"),
        "{'a': 1, 'b': 2} []",
    ),
    "a value of a list": (
        lambda: [
            value_of('[1, "a", true]'),
            value_of("1 2"),
            value_of("{" + "a." * 51 + "b = 1}"),
            value_of("1.50", str),
            value_of("[" * 2000),
        ],
        "[[1, 'a', True], None, None, '1.50', None]",
    ),
    "values as they are shown": (
        lambda: (
            " ".join(shown(v) for v in ({}, list(range(12)), ["a", [True]], "b\nc", 2**201, False, 2.5, "d" * 121))
            + str(len(shown("e" * 120)))
        ),
        r"""
        (a table) [0, 1, 2, 3, 4, 5, 6, 7, 8, 9, …] ["a", [true]] "b\u000ac" (a whole number of 202 bits) false 2.5
        "dddddddddddddddddddddddddddddddddddddddddddddddddddddddddddd…"122
        """,
    ),
    "a fault with all there is": (
        lambda: Fault("a.b", '"5 m"', 7, "is wrong", "another", "c", "m.toml"),
        """m.toml, line 7: a.b = "5 m" is wrong did you mean c? expected: another""",
    ),
    "a fault of a file": (
        lambda: Fault("", "", 0, "is wrong", "another", "", "m.toml"),
        "m.toml is wrong expected: another",
    ),
    "a fault of a key without a value": (
        lambda: Fault("a.b", "", 3, "is missing", "another", "", "m.toml"),
        "m.toml, line 3: a.b is missing expected: another",
    ),
    "sources of several keys, of which two are alike": (
        lambda: source_text(
            {
                "a": Source(3, "paper: Table 2"),
                "b": Source(4, "paper: Table 2"),
                "c": Source(5, "", file="mirror file"),
                "d": Source(6, "paper: Table 3", '"6 cm"', was='"5 cm"'),
            },
            "a",
            "b",
            "x",
            "c",
            "d",
            "a",
        ),
        """
        paper: Table 2; not stated; mirror file, line 5; mission file, line 6, in place of 5 cm (paper: Table 3)
        """,
    ),
    "kinds of sources": (
        lambda: [
            Source(1, comment).kind
            for comment in ("assumption: x", "guess: x", "measured", "identified: a: b", ": x", "")
        ],
        "['assumption', '', '', 'identified', '', '']",
    ),
}


@pytest.mark.parametrize("what", ALL_OF_A_TEXT)
def test_what_is_read_of_a_text_and_what_is_told_of_its_faults(what):
    call, words = ALL_OF_A_TEXT[what]
    assert one_line(str(call())) == one_line(words)


def faults_of(text, load=load_mission):
    """Every fault of a file with this text, in its words."""
    with pytest.raises(MissionError) as refused:
        load("m.toml", text=text)
    return "; ".join(f"{f.key} = {f.value} {f.reason}: {f.expected} ({f.nearest})" for f in refused.value.faults)


ALL_OF_A_FILE = {
    "an unknown key that stands for a missing one": (
        lambda: faults_of(edited("communication.transmit_power", "5", renamed="transmitt_power")),
        """
        communication.transmitt_power = is no key of [communication]: one of transmit_power, wavelength, strehl,
        wavefront_error, pointing_error, distance, transmit_optics_loss, receive_optics_loss, data_rate,
        tracking_split_loss, implementation_loss, receiver_sensitivity, receiver, code_word, beam, coupling, fading
        (transmit_power)
        """,
    ),
    "a table in place of a value": (
        lambda: faults_of(edited("mirror.travel", "{a = 1}")),
        """
        mirror.travel = (a table) is not a quantity in quotes: an angle with its unit; for example travel = "5 urad"
        ()
        """,
    ),
    "two wrong lists and a wrong word": (
        lambda: faults_of(
            edited(
                "scenario.pid_frequencies",
                "[1, 2]",
                edited("conventions.strehl", '"decibels"', edited("scenario.inverse_frequencies", '["5 Hz", "2 Hz"]')),
            )
        ),
        """
        conventions.strehl = "decibels" is none of the choices: strehl = "decibel" or strehl = "ratio" or strehl =
        "unused" ("decibel"); scenario.pid_frequencies = [1, 2] item 1: 1 is a number without a unit; expected a
        frequency with its unit, for example "1 Hz": a list, rising, each item a frequency with its unit, above 0
        Hz, at most 1 THz (); scenario.pid_frequencies = [1, 2] item 2: 2 is a number without a unit; expected a
        frequency with its unit, for example "2 Hz": a list, rising, each item a frequency with its unit, above 0
        Hz, at most 1 THz (); scenario.inverse_frequencies = ["5 Hz", "2 Hz"] does not rise from item to item: a
        list, rising, each item a frequency with its unit, above 0 Hz, at most 1 THz ()
        """,
    ),
    "a name of nothing": (
        lambda: faults_of(edited("name", '""')),
        """name = "" is empty: text in quotes, for example name = "a name" ()""",
    ),
    "a name that is too long": (
        lambda: faults_of(edited("mirror.name", f'"{"n" * 201}"')),
        f"""
        mirror.name = "{"n" * 60}…" has 201 characters: text in quotes, at most 200 characters, for example
        name = "a name" ()
        """,
    ),
    "a switch and a count in quotes": (
        lambda: faults_of(edited("point_ahead.corrected", '"true"', edited("acquisition.attempts", '"3"'))),
        """
        point_ahead.corrected = "true" is neither true nor false: true or false, without quotes; for example
        corrected = true (); acquisition.attempts = "3" is not a whole number: a whole number without quotes, from 1
        to 1000; for example attempts = 2 ()
        """,
    ),
    "a missing key of each kind": (
        lambda: faults_of(edited("conventions.residual", None, edited("requirement.outage", None))),
        """
        conventions.residual = is missing: residual = "per-axis" or residual = "radial" (); requirement.outage = is
        missing: a number without quotes, above 0 and below 1; for example outage = 0.5 ()
        """,
    ),
    "a mirror beside its file": (
        lambda: faults_of(edited("mirror.name", '"a"\nfile = "b.toml"')),
        """
        mirror.file = "b.toml" stands beside other keys of the mirror: file = "mirror.toml" alone in [mirror], or
        all of its other keys ()
        """,
    ),
    "a mirror of version 2": (
        lambda: faults_of(NO_MIRROR + "[mirror]\nversion = 2\n" + REST),
        """
        mirror.version = holds a mirror of several axes, and the paper's loop has one: a mirror file of one axis
        here, and this one in the fine-pointing loop: fine_pointing.mirror_file; microrad design and microrad export
        take it by --mirror, too ()
        """,
    ),
    "a mirror of version 3": (
        lambda: faults_of(NO_MIRROR + MIRROR.replace("[mirror]\n", "[mirror]\nversion = 3\nmodes = 1\n", 1) + REST),
        """
        mirror.version = is no version of a mirror of one axis: version = 2 for a mirror of several axes, and no
        version for one axis (); mirror.modes = is a key of version 2, in a mirror of one axis: this table removed,
        or version = 2 with its keys alone ()
        """,
    ),
    "a mirror without its version": (
        lambda: faults_of(NO_MIRROR + "[mirror]\nmatrices = 1\noutputs = 2\n" + REST),
        """
        mirror.version = is missing, and outputs is a key of version 2: version = 2 in the first line ()
        """,
    ),
    "a file of one axis for several": (
        lambda: faults_of('creep = 1\ntravel = "1 mrad"\n', load_coupled_mirror),
        """
        mirror.version = is missing, and travel is a key of version 1: the file holds a mirror of one axis: a file
        of version 2; microrad.mission.file.load_mirror reads this one ()
        """,
    ),
    "a file of several axes with keys of one": (
        lambda: faults_of('version = 1\nname = "a"\ncreep = 1\nlinear = 2\nmodes = 3\n', load_coupled_mirror),
        """
        mirror.actuators = is missing: a table with the keys name, bias, drive_min, drive_max, rate_limit ();
        mirror.outputs = is missing: a table with the keys name, quantity, position (); mirror.recording = is
        missing: a table with the keys delay, rate, steps_per_sample, excited_from, excited_to (); mirror.matrices =
        is missing: a table with the keys B, C, D, E, F, G, K (); mirror.version = 1 is no version of a mirror of
        several axes: version = 2 for a mirror of several axes, and no version for one axis (); mirror.creep = 1 is
        a key of version 1, in a file of version 2: a real mode in [modes] for each of its lags (); mirror.linear =
        2 is a key of version 1, in a file of version 2: the tables [modes] and [matrices] in its place ();
        mirror.modes = 3 is of the wrong kind: a table with the keys decay, frequency ()
        """,
    ),
}


@pytest.mark.parametrize("what", ALL_OF_A_FILE)
def test_all_faults_of_a_file_are_told_in_full(what):
    call, words = ALL_OF_A_FILE[what]
    assert one_line(str(call())) == one_line(words)


def test_a_radial_error_is_shared_between_two_axes_and_biases_add_up():
    def line(error_rad, kind, axes):
        return PointingLine.model_construct(error_rad=error_rad, kind=kind, axes=axes, statistic="bound")

    lines = {
        "a": line(3e-6, "bias", "per-axis"),
        "b": line(5e-6, "bias", "radial"),
        "c": line(7e-6, "random", "per-axis"),
        "d": line(-1e-6, "bias", "per-axis"),
    }
    pointing = Pointing.model_construct(confidence=0.9, lines=lines)
    assert [each.per_axis_rad for each in lines.values()] == pytest.approx([3e-6, 5e-6 / math.sqrt(2.0), 7e-6, -1e-6])
    assert pointing.bias_rad == pytest.approx(2e-6 + 5e-6 / math.sqrt(2.0))
    assert hash(pointing) != hash(Pointing.model_construct(confidence=0.9, lines=dict(list(lines.items())[::-1])))


@pytest.mark.parametrize(
    ("velocity", "words"),
    [(-1.0, "-1 m/s"), (2.9979246e6, "2998 km/s"), (math.nan, "nan m/s")],
)
def test_a_velocity_that_no_terminal_has_is_refused(velocity, words):
    with pytest.raises(ValueError) as refused:
        point_ahead_rad(velocity)
    assert str(refused.value) == f"a transverse velocity of {words} is out of range; give 0 m/s to 2998 km/s"
    assert point_ahead_rad(8125.0) == pytest.approx(2.0 * 8125.0 / 299792458.0, rel=1e-15)
    assert point_ahead_rad(0.0) == 0.0


def test_roots_are_a_pair_each_or_one_where_they_are_real():
    roots = roots_from_damping((10.0, 20.0, 30.0), (0.25, 1.0, -1.0))
    w = 2.0 * math.pi * np.array([10.0, 20.0, 30.0])
    pair = w[0] * complex(-0.25, math.sqrt(1.0 - 0.0625))
    assert roots == pytest.approx((pair, pair.conjugate(), complex(-w[1]), complex(w[2])), rel=1e-12)
    by_roots = made(
        LinearPart, poles_hz=(10.0, 20.0), pole_dampings=(0.25, 1.0), zeros_hz=(30.0,), zero_dampings=(-1.0,)
    )
    assert by_roots.roots == ((roots[3],), roots[:3])
    by_numbers = made(LinearPart, numerator=(2.0, -6.0), denominator=(1.0, 3.0, 2.0))
    zeros, poles = by_numbers.roots
    assert (zeros, sorted(pole.real for pole in poles)) == (pytest.approx((3.0,)), pytest.approx([-2.0, -1.0]))


def test_the_least_alpha_is_that_of_the_worse_of_both_signs():
    assert mirror_table.least_alpha_1_v(-0.75, 0.5, 0.125) == 0.875 + 0.5
    assert mirror_table.least_alpha_1_v(0.75, 0.5, 0.125) == pytest.approx(max(0.875 - 0.5, 0.625 + 0.5))
    assert mirror_table.least_alpha_1_v(0.75, -0.5, 0.125) == 1.375
    assert mirror_table.least_alpha_1_v(-0.25, 0.0, 0.0) == 0.25


def test_a_correlation_is_read_row_by_row_below_its_diagonal():
    table = made(Uncertainty, parameters=("a", "b", "c", "d"), correlation=(0.1, 0.2, 0.3, 0.4, 0.5, 0.6))
    rows = [[1.0, 0.1, 0.2, 0.4], [0.1, 1.0, 0.3, 0.5], [0.2, 0.3, 1.0, 0.6], [0.4, 0.5, 0.6, 1.0]]
    assert table.correlation_rows == rows
    assert table._least_eigenvalue() == pytest.approx(float(np.linalg.eigvalsh(np.array(rows))[0]))
    none = made(Uncertainty, parameters=("a", "b"), correlation=())
    assert (none.correlation_rows, none._least_eigenvalue()) == ([[1.0, 0.0], [0.0, 1.0]], 1.0)


def test_a_parameter_is_found_at_its_table_its_field_and_its_item():
    mirror = known()
    found = [
        tuple(place(mirror, key))
        for key in ("linear.poles.3", "creep.weights", "creep.weights.1", "linear.pole_dampings.3")
    ]
    assert found == [
        ("linear", "poles_hz", 2),
        ("creep", "weights_rad_v", None),
        ("creep", "weights_rad_v", 0),
        ("linear", "pole_dampings", 2),
    ]


@pytest.mark.parametrize(
    ("of", "value", "words"),
    [
        (
            Quantity("rad", most=math.pi / 2, typical="deg"),
            math.radians(90.001),
            "x is 90.001 deg: it must be finite, at most 90 deg",
        ),
        (Quantity("m", most=50e3), 50000.01, "x is 50.00001 km: it must be finite, at most 50 km"),
        (Quantity("", most=1.0), 1.0000001, "x is 1.0000001: it must be finite, at most 1"),
        (Quantity("m", above=0.0), 0.0, "x is 0 m: it must be finite, above 0 m"),
        (Quantity("m", least=2.0, most=3.0), 1.99996, "x is 1.99996 m: it must be finite, at least 2 m, at most 3 m"),
        (Whole("", least=1, most=9), 9.00001, "x is 9.00001: it must be whole, at least 1, at most 9"),
    ],
)
def test_a_value_that_is_refused_has_the_digits_that_tell_it_from_its_bounds(of, value, words):
    with pytest.raises(ValueError) as refused:
        of.check("x", value)
    assert str(refused.value) == words


@pytest.mark.parametrize("table", [
    'file = "nowhere.toml"\n', "file = 5\n", 'file = ""\n', 'file = "mirror.toml"\nbias = "6 V"\n', "version = 2\n", "",
])  # fmt: skip
def test_a_mirror_that_is_given_is_the_missions_whatever_it_says_of_its_own(tmp_path, table):
    (tmp_path / "play.toml").write_text(MIRROR_WITHOUT_MODEL + PLAY, encoding="utf-8")
    file = load_mission(tmp_path / "mission.toml", tmp_path / "play.toml", text=f"{NO_MIRROR}[mirror]\n{table}{REST}")
    assert file.mission.mirror == load_mirror(tmp_path / "play.toml").mirror
    assert (file.mirror_file.path, file.path) == (tmp_path / "play.toml", tmp_path / "mission.toml")
    assert not file.sources.keys() & {"mirror.file", "mirror.version"}


def test_a_document_with_other_values_has_its_own_faults_and_leaves_the_first_as_it_was(tmp_path):
    (tmp_path / "bent.toml").write_text(edited("travel", '"2.5 m"', MIRROR_TEXT), encoding="utf-8")
    (tmp_path / "play.toml").write_text(MIRROR_WITHOUT_MODEL + PLAY, encoding="utf-8")
    document = open_mission(tmp_path / "mission.toml", text=f'{NO_MIRROR}[mirror]\nfile = "bent.toml"\n{REST}')
    changed = {**document.data, "beacon": {**document.data["beacon"], "distance": "44000"}}
    told = []
    for _ in range(2):
        with pytest.raises(MissionError) as refused:
            mission_file(with_values(document, changed))
        told.append([(fault.key, Path(fault.file).name) for fault in refused.value.faults])
    assert told == [[("beacon.distance", "mission.toml"), ("mirror.travel", "bent.toml")]] * 2
    assert document.all_faults() == []
    assert document.data["beacon"]["distance"] != "44000"
    other = mission_file(with_values(document, document.data, tmp_path / "play.toml"))
    assert (other.mirror_file.path, other.mission.mirror.bouc_wen) == (tmp_path / "play.toml", None)
    with pytest.raises(MissionError) as refused:
        mission_file(document)
    assert [fault.key for fault in refused.value.faults] == ["mirror.travel"]


def test_half_a_character_in_a_text_is_refused_with_its_line(tmp_path):
    lines = TEXT.split("\n")
    lines[4] += "  # \ud800"
    for load in (load_mission, load_link):
        with pytest.raises(MissionError) as refused:
            load(tmp_path / "m.toml", text="\n".join(lines))
        fault = the_fault(refused.value)
        assert (fault.reason, fault.file) == ("the mission file is not UTF-8 text (line 5)", str(tmp_path / "m.toml"))


def test_of_a_hundred_unknown_keys_each_is_told_and_of_more_a_hundred(refuse):
    for count in (100, 130):
        more = "".join(f"strange_{k} = {k}\n" for k in range(count))
        faults = refuse(TEXT.replace("[scenario]\n", f"[scenario]\n{more}")).faults
        assert [(fault.key, fault.value) for fault in faults] == [(f"scenario.strange_{k}", "") for k in range(100)]


@pytest.mark.parametrize(
    ("key", "reason"),
    [("mirror.composition", "is none of the choices"), ("name", "is empty"), ("mirror.name", "is empty")],
)
def test_an_empty_text_is_told_as_what_its_key_holds(refuse, key, reason):
    fault = the_fault(refuse(edited(key, '""')))
    assert (fault.key, fault.value, fault.reason) == (key, '""', reason)


def test_a_fault_of_a_table_that_has_only_others_inside_stands_where_the_first_of_those_does():
    text = b"x = 1\n[beacons]\na = 1\n[beacon_2.inner]\na = 2\n[beacon.lines.a]\na = 3\n[beacon.lines.b]\na = 4\n"
    document = Document.of(text, Path("m.toml"), "mission file")
    for key in ("beacon", "beacon.lines", "beacon.lines.b", "beacon.lines.b.c", "beacon.other", "answer"):
        document.fault(key, "", "is wrong", "another")
    assert [(fault.key, fault.line) for fault in document.faults] == [
        ("beacon", 6), ("beacon.lines", 6), ("beacon.lines.b", 8), ("beacon.lines.b.c", 8), ("beacon.other", 0),
        ("answer", 0),
    ]  # fmt: skip


@pytest.mark.parametrize(("given", "meant", "said"), [
    ("gau\u00dfian", "gaussian", ", it holds U+00DF (LATIN SMALL LETTER SHARP S)"),
    ("\u00b5m\u0430", "\u00b5ma", ", it holds U+0430 (CYRILLIC SMALL LETTER A)"),
    ("\u00b5ma", "\u00b5mas", ""),
    ("a ", "a", ", it begins or ends with a blank"),
    ("\ue000", "a", ", it holds U+E000 (a character without a name)"),
])  # fmt: skip
def test_what_sets_two_words_apart_is_a_letter_that_the_other_does_not_have(given, meant, said):
    assert toml._apart(given, meant) == said


def test_ten_items_of_a_list_are_shown_and_ten_thousand_lines_read():
    assert shown(list(range(10))) == "[0, 1, 2, 3, 4, 5, 6, 7, 8, 9]"
    assert shown(list(range(11))) == "[0, 1, 2, 3, 4, 5, 6, 7, 8, 9, …]"
    assert shown(2**200 - 1) == toml.clipped(str(2**200 - 1)) and shown(-(2**200)) == "(a whole number of 201 bits)"
    assert Document.of(b"a = 1" + b"\n" * 10_000, Path("m.toml"), "mission file").data == {"a": 1}


def coupled(**given):
    return SimpleNamespace(
        coupling=SimpleNamespace(**{"angular_error_rad": 0.0, "mode_radius_m": None, "is_random": False} | given),
        wavelength_m=1.55e-6,
    )


@pytest.mark.parametrize(("focal_length_m", "fits"), [(0.3, False), (0.373, False), (0.374, True), (2.0, True)])
def test_the_cone_of_a_fibre_is_held_against_the_obscuration_of_the_telescope_that_receives(focal_length_m, fits):
    """0.3 of 0.25 m are stopped, and 2 f tan(asin 0.1) of the aperture is the fibre's."""
    terminals = SimpleNamespace(geo_obscuration=0.3, geo_aperture_m=0.25, leo_aperture_m=0.05, leo_obscuration=0.9)
    link_table = coupled(numerical_aperture=0.1, focal_length_m=focal_length_m)
    found = list(model._coupling_fits(terminals, link_table, SimpleNamespace(outage=None)))
    assert [problem.key for problem in found] == ["communication.coupling.numerical_aperture"] * (not fits)
    open_one = SimpleNamespace(geo_obscuration=None, geo_aperture_m=0.25)
    assert list(model._coupling_fits(open_one, link_table, SimpleNamespace(outage=None))) == []


@pytest.mark.parametrize(
    ("factor", "fits"), [(0.9799, False), (0.9801, True), (1.0, True), (1.0199, True), (1.0201, False)]
)
def test_the_point_ahead_of_a_loop_is_that_of_the_velocity_to_a_fiftieth(factor, fits):
    fine = SimpleNamespace(reference=SimpleNamespace(point_ahead_rad=factor * 2.0 * 7500.0 / 299_792_458.0))
    found = list(model._point_ahead_fits(SimpleNamespace(transverse_velocity_m_s=7500.0), fine))
    assert [(problem.key, problem.expected) for problem in found] == [
        ("fine_pointing.reference.point_ahead", 'point_ahead = "50 \u00b5rad" would do')
    ] * (not fits)


@pytest.mark.parametrize(("station", "turbulence", "fine", "held"), [
    ("leo", 1, 1, True), ("geo", 1, 1, False), ("leo", None, 1, False), ("leo", 1, None, False), (None, 1, 1, False),
])  # fmt: skip
def test_a_loop_tracks_through_turbulence_at_a_station_that_it_stands_on(station, turbulence, fine, held):
    path = None if station is None else SimpleNamespace(station=station)
    mission = SimpleNamespace(channel=SimpleNamespace(turbulence=turbulence), fine_pointing=fine, path=path)
    assert model.Mission.loop_in_turbulence.fget(mission) is held
    mission.channel = None
    assert model.Mission.loop_in_turbulence.fget(mission) is False


@pytest.mark.parametrize(("comment", "kind"), [
    ("assumption: a guess", "assumption"), ("assumption", ""), ("a paper: Table 1", ""), ("paper: a: b", "paper"),
    ("Paper: Table 1", ""), (" paper: Table 1", ""), ("unknown:", "unknown"), ("", ""), (":", ""),
])  # fmt: skip
def test_a_comment_is_of_a_kind_that_stands_before_its_colon(comment, kind):
    source = model.Source(7, comment)
    assert (source.kind, source.text) == (kind, comment or "mission file, line 7")
    moved = model.Source(7, comment, "2", "mirror file", '"5 cm"')
    assert moved.text == f"mirror file, line 7, in place of 5 cm ({comment})"


def test_sources_of_several_keys_are_said_once_in_their_order():
    sources = {"a": model.Source(1, "paper: b"), "b": model.Source(2, ""), "c": model.Source(3, "paper: b")}
    text = model.source_text(sources, "c", "x", "b", "a", "y")
    assert text == "paper: b; not stated; mission file, line 2" and model.source_text(sources) == ""


@pytest.mark.parametrize("rate", [0.0, -1.0, math.nan])
def test_counts_of_a_rate_that_is_not_known_are_not_known(rate):
    receiver = made(Receiver, background_power_w=2e-12, efficiency=0.5, dark_count_rate_1_s=300.0)
    photons = 0.5 * 2e-12 * 1e-6 / (6.62607015e-34 * 299_792_458.0)
    assert receiver._counts(1e6, 1e-6) == pytest.approx((photons + 300.0) / 1e6)
    assert receiver._counts(rate, 1e-6) is None
    assert made(Receiver, background_power_w=None)._counts(1e6, 1e-6) is None


@pytest.mark.parametrize(("own", "radius_m", "fits"), [
    (0.5, 0.0115, False), (0.5, 0.0117, True), (None, 1e-4, True), (0.2, 0.005, True),
])  # fmt: skip
def test_a_beam_is_held_against_the_obscuration_of_the_terminal_that_it_leaves(own, radius_m, fits):
    """Of 0.07 m: exp(-2 r^2 / w^2) is 1 % where w is 0.659 r, with r half of 0.5 times 0.07 m."""
    terminals = SimpleNamespace(leo_obscuration=own, leo_aperture_m=0.07, geo_obscuration=0.9, geo_aperture_m=0.9)
    found = list(obscuration_fits(terminals, SimpleNamespace(beam=SimpleNamespace(radius_m=radius_m))))
    assert [problem.key for problem in found] == ["communication.beam.radius"] * (not fits)


@pytest.mark.parametrize("months", [1, 2, 11, 13, 24])
def test_a_year_has_neither_more_nor_fewer_than_twelve_months(months):
    with pytest.raises(ProblemsError) as refused:
        Monthly(PLAIN).read([1.0] * months)
    assert refused.value.problems[0].reason == f"is a list of {months}, and a year has 12 months"
    assert Monthly(PLAIN).read([2.0] * 12) == (2.0,) * 12


def test_a_file_of_just_the_most_lines_and_bytes_is_read_and_one_more_is_not():
    most = b"a = 1\n" + b"\n" * 9_999
    assert read_as(most, most_bytes=len(most)) == "{'a': 1} [] "
    assert "is larger than 10 kB" in read_as(most, most_bytes=len(most) - 1)
    assert "has more than 10000 lines" in read_as(most + b"\n", most_bytes=len(most) + 1)


def test_a_list_of_keys_may_have_just_the_most_items():
    assert KeyList(None, most=2).read(["a", "b"]) == ("a", "b")
    with pytest.raises(ProblemsError):
        KeyList(None, most=2).read(["a", "b", "c"])


def test_the_schema_names_its_draft_and_lets_the_mirror_stand_in_another_file():
    schema = mission_schema()
    assert schema["$schema"] == "https://json-schema.org/draft/2020-12/schema"
    here, there = schema["properties"]["mirror"]["anyOf"]
    assert schema["$defs"][here["$ref"].removeprefix("#/$defs/")]["title"] == "Mirror"
    assert there == {
        "type": "object",
        "properties": {"file": {"type": "string", "description": "mirror file, seen from the mission file"}},
        "required": ["file"],
        "additionalProperties": False,
    }
    assert list(schema["properties"])[:2] == ["name", "pointing"]
    assert "transmit_power" in schema["$defs"]["Communication"]["required"]


@pytest.mark.parametrize(("content", "most_bytes", "data"), [
    (b"a = 1\n" + b"#" * 294, 300, {"a": 1}),
    (b"a = 1" + b"\n" * 10_000, 20_000, {"a": 1}),
    (b"a" * 200 + b" = 1", 300, {"a" * 200: 1}),
    (b"a = 1" + b"0" * 399, 600, {"a": 10**399}),
    (b"x.max = 1\n'x x'.\"xx\" = 2", 300, {"x": {"max": 1}, "x x": {"xx": 2}}),
    (b"a = 1\r\n[b]\r\nc = '''d\r\ne'''", 300, {"a": 1, "b": {"c": "d\ne"}}),
])  # fmt: skip
def test_a_file_as_large_as_it_may_be_is_read_whole(content, most_bytes, data):
    document = Document.of(content, Path("m.toml"), "mission file", most_bytes=most_bytes)
    assert (document.data, document.faults) == (data, [])
    leaves = [(k, v) for k, v in data.items() if not isinstance(v, dict)]
    leaves += [(f"{k}.{n}", v) for k, inner in data.items() if isinstance(inner, dict) for n, v in inner.items()]
    assert {s.key for s in document.statements.values() if s.kind == "key"} == {key for key, _ in leaves}
    assert document.sha256 == hashlib.sha256(content).hexdigest()


@pytest.mark.parametrize("parts", [50, 51])
def test_a_key_of_fifty_parts_is_read_and_one_more_is_too_many(parts):
    inner = ".".join(["a", "'b c'", '"d"', "e-f"] * 13)[: 10**6]
    named = " . ".join(f"k{place}" for place in range(parts))
    found = read_as(f"a = {{{named} = 5}}\nb = 7\n".encode(), most_bytes=2000)
    if parts == 50:
        assert value_of(f"{{{named} = 5}}") is not None and found.endswith(", 'b': 7} [] ")
    else:
        assert value_of(f"{{{named} = 5}}") is None
        assert found.startswith("{'b': 7} ['a'] m.toml, line 1: a = {k0 . k1")
        assert one_line(found).endswith("… holds a key of more than 50 parts expected: a table with keys of its own")
    assert value_of(f"{{{inner} = 5}}") is None  # of quoted parts too


@pytest.mark.parametrize(("content", "line"), [(b"\xff", 1), (b"a = 1\n# \xff\xff", 2), (b"\n\r\n\n\xe9", 4)])
def test_the_line_of_the_first_letter_in_another_code_is_told(content, line):
    assert read_as(content) == (f"unreadable: is not UTF-8 text (line {line}); expected the file saved again as UTF-8")


@pytest.mark.parametrize(("content", "words"), [
    (b"a = 1\nwords = here = 3\nwords here\n b = 2",
     "{'a': 1, 'b': 2} ['', 'words'] m.toml, line 3: words here is neither a key with its value nor a table header "
     'expected: key = "value", [table] or # comment; m.toml, line 2: words = here = 3 is not TOML expected: text in '
     'quotes: words = "here = 3"'),
    (b"[c]\na = [1,\n  [2\nb = {d = 3\n[e]\nf = 4",
     "{'c': {}, 'e': {'f': 4}} ['c.a', 'c.b'] m.toml, line 2: c.a = [1, [2 has a bracket that is not closed "
     "expected: a closing bracket before the next key; m.toml, line 4: c.b = {d = 3 has a bracket that is not closed "
     "expected: a closing bracket before the next key"),
    (b"a" * 201 + b" = 1\nb = 2",
     f"{{'b': 2}} ['{'a' * 201}'] m.toml, line 1: {'a' * 60}… = 1 is a key of 201 characters expected: a key of the "
     "mission file"),
])  # fmt: skip
def test_what_is_no_statement_is_set_aside_and_the_rest_is_read(content, words):
    assert one_line(read_as(content, most_bytes=900).replace("\\u000a", " ")) == words


@pytest.mark.parametrize(("count", "shown_of", "more"), [(1, 1, ""), (2, 2, ""), (50, 50, ""), (51, 50, "and 1 more")])
def test_up_to_fifty_faults_are_told_by_file_and_line_and_of_more_how_many(count, shown_of, more):
    """The file that was asked for comes first, whatever the names."""
    faults = [toml.Fault(f"k{n}", str(n), n, "is wrong", "right", file="z.toml") for n in range(count, 1, -1)]
    error = MissionError(Path("z.toml"), [toml.Fault("", "", 0, "is gone", "it", file="a.toml"), *faults])
    lines = str(error).split("\n")
    assert lines[0] == f"z.toml: {count} fault{'s' * (count > 1)} to correct"
    assert [each.line for each in error.faults] == [*range(2, count + 1), 0]
    assert sum(line.startswith(("z.toml, line", "a.toml")) for line in lines[1:]) == shown_of
    assert (lines[-1] if more else "") == more


SMALL_ANGLE = Quantity("rad", "deg", above=0.0, most=0.01)


@pytest.mark.parametrize(("rule", "value", "reason", "expected", "example"), [
    # the number as it stands, in the unit in which it is mostly written, where that is within the bounds
    (Quantity("m", "cm", above=0.0, most=3.0), "7", "is a number without a unit", "a length with its unit", "7 cm"),
    (Quantity("m", "km", least=2e3), "7", "is a number without a unit", "a length with its unit", "7 km"),
    (Quantity("m", "", least=2.0), "7", "is a number without a unit", "a length with its unit", "7 m"),
    (SMALL_ANGLE, "7", "is a number without a unit", "an angle with its unit", "0.5 deg"),
    (SMALL_ANGLE, "7 V", 'is in "V", another kind of quantity', "an angle with its unit", "0.5 deg"),
    (SMALL_ANGLE, "0 deg", "is not above 0 deg", "an angle with its unit, above 0 deg, at most 0.573 deg", "0.5 deg"),
    (SMALL_ANGLE, "1 deg", "is above 0.573 deg", "an angle with its unit, above 0 deg, at most 0.573 deg", "0.5 deg"),
])  # fmt: skip
def test_an_example_of_a_value_is_one_that_would_be_taken(rule, value, reason, expected, example):
    with pytest.raises(UnitError) as refused:
        rule.read(value)
    error = refused.value
    assert (error.reason, error.expected, error.example) == (reason, expected, example)
    assert str(error) == f'"{value}" {reason}; expected {expected}, for example "{example}"'
    assert rule.out_of_bounds(rule.read(example)) == ""


@pytest.mark.parametrize("folder", ["of\x1b[31m ours", "f" * 130])
def test_faults_of_a_file_whose_path_is_long_or_would_steer_a_terminal_stand_before_those_of_its_mirror(
    tmp_path, folder
):
    path, given = tmp_path / folder / "mission.toml", tmp_path / "a.toml"
    path.parent.mkdir()
    path.write_text(edited("communication.distance", '"44000"'), encoding="utf-8")
    given.write_text(edited("travel", '"2.5 m"', MIRROR_TEXT), encoding="utf-8")
    with pytest.raises(MissionError) as refused:
        load_mission(path, given)
    told_of = str(path).replace("\x1b", "\\u001b") if len(str(path)) < 120 else f"{str(path)[:60]}…"
    assert [(fault.file, fault.key) for fault in refused.value.faults] == [
        (told_of, "communication.distance"),
        (str(given), "mirror.travel"),
    ]
    first, second, *_ = str(refused.value).splitlines()
    assert first == f"{told_of}: 2 faults to correct"
    assert second.startswith(f"{told_of}, line {line_of('communication.distance', TEXT)}: communication.distance")
    path.write_text("\0", encoding="utf-8")
    with pytest.raises(MissionError) as refused:
        load_mission(path)
    assert (str(refused.value.path), refused.value.faults[0].file) == (str(path), told_of)


@pytest.mark.parametrize(
    ("key", "reason"),
    [
        ("scenario.pid_frequencies", "is not a list with something in it"),
        ("scenario.amplitude", "is not a quantity in quotes"),
        ("point_ahead.corrected", "is neither true nor false"),
        ("requirement.residual_statistic", "is none of the choices"),
    ],
)
def test_a_table_where_a_value_belongs_is_shown_as_one(refuse, key, reason):
    text = edited(key, None) + f"\n[{key}]\nfirst = 1\n"
    fault = the_fault(refuse(text))
    assert (fault.key, fault.value, fault.reason) == (key, "(a table)", reason)
    assert fault.line == line_of(key, text)


def test_the_first_item_of_a_list_is_looked_at_by_itself():
    mirror = known()
    assert tuple(place(mirror, "linear.pole_dampings.1")) == ("linear", "pole_dampings", 0)
    linear = mirror.linear.model_copy(update={"poles_hz": (0.0, 900.0, 1e3)})
    slow = mirror.model_copy(update={"linear": linear})
    assert tuple(place(slow, "linear.poles.2")) == ("linear", "poles_hz", 1)
    (problem,) = refused(place, slow, "linear.poles.1")
    assert problem.reason == 'has "linear.poles.1", which is 0 in this mirror, and nothing is relative to 0'


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="needs named pipes")
def test_a_pipe_that_a_mission_names_is_not_waited_for(tmp_path):
    for name in ("satellite.tle", "vibration.csv"):
        os.mkfifo(tmp_path / name)
    (tmp_path / "folder.oem").mkdir()
    (tmp_path / "series.csv").write_bytes(b"\xff1")
    names = ("satellite.tle", "folder.oem", "series.csv", "none.csv", "a\0b", "vibration.csv")
    with no_hang():
        assert [_content(tmp_path / name) for name in names] == [None, None, b"\xff1", None, None, None]


def test_files_that_a_mission_names_are_those_of_its_orbits_its_constellation_its_fading_and_its_loop():
    ends = SimpleNamespace(leo=SimpleNamespace(file="a"), geo=SimpleNamespace(file="b"))
    swarm, fading = SimpleNamespace(file="c"), SimpleNamespace(fading=SimpleNamespace(series="d"))
    loop = SimpleNamespace(vibration=SimpleNamespace(file="e"), mirror_file="f")
    plain, none = SimpleNamespace(fading=None), SimpleNamespace(file=None)
    for table in (Mission, LinkMission):
        of_all = made(table, orbit=ends, constellation=swarm, communication=fading, fine_pointing=loop)
        assert "".join(named_files(of_all)) == ("abcdef" if table is Mission else "abcd")
        again = SimpleNamespace(leo=none, geo=SimpleNamespace(file="c"))
        few = made(table, orbit=again, constellation=swarm, communication=plain)
        assert named_files(few) == ("c",)
        assert named_files(made(table, communication=plain)) == ()
        assert named_files(made(table, communication=fading, constellation=none)) == ("d",)
    half = SimpleNamespace(vibration=none, mirror_file="f")
    assert named_files(made(Mission, communication=fading, fine_pointing=half)) == ("d", "f")
