"""The [fine_pointing] table: what a good one holds, and what a bad one is told, with a value that would do."""

import math
import re
import tomllib
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from made_tables import made, one_line, told
from microrad.loop import disturbance, sensor
from microrad.mirror import geometry
from microrad.mission.file import MissionError, load_mission
from microrad.mission.model import mission_schema
from microrad.mission.tables import fine_pointing as fine_pointing_table
from microrad.mission.tables.fine_pointing import (
    FinePointing,
    GeometryTable,
    MisalignmentTable,
    OpticalSensorTable,
    VibrationTable,
    WheelsTable,
    clock_problems,
)
from microrad.mission.toml import scan
from places import ROOT

SHIPPED = ROOT / "missions" / "paper.toml"
TEXT = SHIPPED.read_text(encoding="utf-8")
BEFORE, TABLE = re.fullmatch(r"(.*?)(\[fine_pointing\]\n.*)", TEXT, re.DOTALL).groups()


def edited(*changes, text=TEXT):
    """The text with keys below fine_pointing given another value, taken out (None), or added to their table."""
    for key, value in changes:
        statements = [s for s in scan(text) if s.key == f"fine_pointing.{key}" and s.kind == "key"]
        lines = text.split("\n")
        name = key.rpartition(".")[2]
        if statements:
            lines[statements[0].line - 1] = "" if value is None else f"{name} = {value}"
        else:
            header = f"[fine_pointing.{key.rpartition('.')[0]}]".replace(".]", "]")
            lines.insert(lines.index(header) + 1, f"{name} = {value}")
        text = "\n".join(lines)
    return text


def uncommented(header):
    """The shipped text with a table that is commented out put into force."""
    lines = TEXT.split("\n")
    place = lines.index(f"# [{header}]")
    while lines[place].startswith("# "):
        lines[place] = lines[place].removeprefix("# ")
        place += 1
    return "\n".join(lines)


@pytest.fixture
def load(tmp_path):
    """Write a text and read its table."""

    def read(text):
        path = tmp_path / "mission.toml"
        path.write_text(text, encoding="utf-8")
        return load_mission(path).mission.fine_pointing

    return read


@pytest.fixture
def refuse(load):
    """Write a text with one fault, and return that fault."""

    def read(text):
        with pytest.raises(MissionError) as refused:
            load(text)
        (fault,) = refused.value.faults
        assert all(part in str(refused.value) for part in (fault.key, fault.value, fault.reason, fault.expected))
        return fault

    return read


# ---- a good table
@pytest.mark.promise("pointing-1")
def test_the_shipped_table_is_read_in_si(load):
    table = load(TEXT)
    assert (table.rate_hz, table.delay_s, table.plant_step_s) == (5e3, 200e-6, 40e-6)
    assert (table.amplifier_bandwidth_hz, table.drive_resolution_v, table.reference_filter_hz) == (1e3, 0.305e-3, 1e3)
    assert (table.modulus_margin, table.quantile) == (0.5, 0.997)
    assert (table.runs, table.duration_s, table.settle_s, table.seed) == (64, 2.0, 0.5, 1)
    assert (table.geometry.layout, table.geometry.travel_angle) == ("two-axis", "optical")
    assert (table.geometry.incidence_rad, table.geometry.magnification, table.geometry.rotation_rad) == (0.0, 1.0, 0.0)
    assert (table.geometry.coupling, table.geometry.actuator_radius_m) == ((1.0, 0.0, 0.0, 1.0), None)
    assert (table.vibration.spectrum, table.vibration.convention) == ("olympus", "radial")
    assert (table.body.error_rad, table.body.sigmas, table.body.bandwidth_hz) == (300e-6, 3.0, 0.1)
    assert table.body.convention == "per-axis"
    optical, gauge, reference = table.optical_sensor, table.strain_gauge, table.reference
    assert (optical.noise_rad, optical.field_of_view_rad, optical.resolution_rad) == (1e-6, 2e-3, 0.0)
    assert (optical.rate_hz, optical.delay_s, optical.quad_cell) == (5e3, 0.0, None)
    assert (gauge.noise_rad, gauge.resolution_rad) == (0.1e-6, 0.027e-6)
    assert (reference.point_ahead_rad, reference.line_of_sight_rate_rad_s) == (71e-6, 255e-6)
    assert (reference.point_ahead_on_mirror, reference.rate_feedforward) == (True, 0.99)
    assert table.wheels is None


def test_whole_numbers_and_switches_keep_their_kind(load):
    table = load(edited(("seed", str(2**63 - 1)), ("runs", "1"), ("reference.point_ahead_on_mirror", "false")))
    assert table.seed == 2**63 - 1  # no float holds it
    assert (type(table.seed), type(table.runs), table.runs) == (int, int, 1)
    assert table.reference.point_ahead_on_mirror is False


def test_every_value_of_the_shipped_table_says_where_it_comes_from():
    sources = {k: s for k, s in load_mission(SHIPPED).sources.items() if k.startswith("fine_pointing.")}
    assert len(sources) == len(re.findall(r"^\w+ = ", TABLE, re.MULTILINE)) > 30
    assert {source.kind for source in sources.values()} == {"paper", "assumption"}


def test_a_mission_does_without_the_table_and_is_the_same_otherwise(tmp_path):
    path = tmp_path / "mission.toml"
    path.write_text(BEFORE, encoding="utf-8")
    mission = load_mission(path).mission
    assert mission.fine_pointing is None
    assert mission.model_dump(exclude={"fine_pointing"}) == load_mission(SHIPPED).mission.model_dump(
        exclude={"fine_pointing"}
    )


def test_only_wheels_strain_gauge_and_quad_cell_may_be_left_out(refuse, load):
    for name in ("geometry", "vibration", "body", "optical_sensor", "reference"):
        fault = refuse(re.sub(rf"\[fine_pointing\.{name}\]\n(?:[^\[]*=.*\n)*", "", TEXT))
        assert (fault.key, fault.reason) == (f"fine_pointing.{name}", "is missing")
        assert "a table with the keys" in fault.expected
    assert load(re.sub(r"\[fine_pointing\.strain_gauge\]\n.*\n.*\n", "", TEXT)).strain_gauge is None


@pytest.mark.promise("pointing-8")
def test_what_is_optional_has_no_other_default():
    optional = {name for name, field in FinePointing.model_fields.items() if not field.is_required()}
    assert optional == {"wheels", "misalignment", "strain_gauge", "mirror_file"}
    shipped = {key.removeprefix("fine_pointing.") for key in load_mission(SHIPPED).sources if "fine_pointing" in key}
    assert {key for key in shipped if "." not in key} == {
        field.alias or name
        for name, field in FinePointing.model_fields.items()
        if not hasattr(field.annotation, "model_fields") and name not in optional
    }


@pytest.mark.promise("pointing-9")
@pytest.mark.parametrize(
    ("keys", "expected"),
    [
        ({"spectrum": '"first-order"', "level": '"160 urad^2/Hz"', "corner": '"2 Hz"'}, (160e-12, 2.0)),
        ({"spectrum": '"bands"', "edges": '["0 Hz", "1 Hz", "10 Hz"]', "rms": '["8.6 urad", "2.8 urad"]'},
         ((0.0, 1.0, 10.0), (8.6e-6, 2.8e-6))),
        ({"spectrum": '"table"', "file": '"lab/spectrum.csv"'}, ("lab/spectrum.csv",)),
    ],
)  # fmt: skip
def test_each_spectrum_has_its_own_keys(load, keys, expected):
    vibration = load(edited(*((f"vibration.{key}", value) for key, value in keys.items()))).vibration
    attributes = {"level": "level_rad2_hz", "corner": "corner_hz", "edges": "edges_hz", "rms": "rms_rad"}
    read = {key: getattr(vibration, attributes.get(key, key)) for key in ("level", "corner", "edges", "rms", "file")}
    assert tuple(read[key] for key in keys if key != "spectrum") == expected
    assert all(value is None for key, value in read.items() if key not in keys)


def test_a_tripod_has_a_radius(load):
    table = load(edited(("geometry.layout", '"tripod"'), ("geometry.actuator_radius", '"10 mm"'))).geometry
    assert (table.layout, table.actuator_radius_m) == ("tripod", 0.01)


# ---- the parts that the table is for take it as it is
def test_the_shipped_disturbances_have_the_rms_that_their_comments_say(load):
    table = load(TEXT)
    shaken = disturbance.olympus(convention=table.vibration.convention)
    assert math.sqrt(2.0) * shaken.rms_rad == pytest.approx(15.9e-6, rel=5e-3)
    body = table.body
    slow = disturbance.body_pointing(body.error_rad, body.sigmas, body.bandwidth_hz, convention=body.convention)
    assert slow.rms_rad == pytest.approx(100e-6, rel=1e-9)


def test_the_wheel_that_is_commented_out_has_the_lines_that_it_says(load):
    wheels = load(uncommented("fine_pointing.wheels")).wheels
    made = disturbance.wheels(
        wheels.speed_hz, wheels.harmonics, wheels.coefficients_rad_hz2, convention=wheels.convention
    )
    lines = [(line.freq_hz, line.amplitude_rad) for line in made.lines]
    np.testing.assert_allclose(lines, [(50.0, 0.25e-6), (100.0, 0.1e-6)], rtol=1e-12)


MISALIGNED = '[fine_pointing.misalignment]\noffset = ["20 urad", "-5 urad"]\ndrift = ["0.1 urad/s", "0 urad/s"]\n\n'


def test_a_misalignment_has_an_offset_and_a_drift_about_each_axis(load, refuse):
    text = TEXT.replace("[fine_pointing.optical_sensor]", f"{MISALIGNED}[fine_pointing.optical_sensor]")
    found = load(text).misalignment
    assert (found.offset_rad, found.drift_rad_s) == (pytest.approx((20e-6, -5e-6)), pytest.approx((1e-7, 0.0)))
    for key, item in (("offset", '"-5 urad"'), ("drift", '"0 urad/s"')):
        fault = refuse(text.replace(f", {item}]", "]"))
        assert (fault.key, fault.reason) == (f"fine_pointing.misalignment.{key}", "has 1 item")
        assert fault.expected.startswith("two, for x and y")
    assert refuse(text.replace('"0.1 urad/s"', '"0.1 urad"')).key == "fine_pointing.misalignment.drift"


def test_the_quad_cell_that_is_commented_out_has_the_noise_that_it_says(load):
    text = uncommented("fine_pointing.optical_sensor.quad_cell")
    table = load(edited(("optical_sensor.noise", None), text=text))
    quad, mission = table.optical_sensor.quad_cell, load_mission(SHIPPED).mission
    cell = sensor.QuadCell(
        quad.responsivity_a_w, quad.background_power_w, quad.dark_current_a, quad.thermal_noise_a_sqrt_hz
    )
    spot = sensor.AirySpot(mission.answer.wavelength_m, mission.terminals.leo_aperture_m)
    line = sensor.noise_equivalent_angle_line(cell, spot, quad.received_power_w, table.optical_sensor.rate_hz)
    assert line.value == pytest.approx(0.97e-6, rel=5e-3)
    assert quad.received_power_w == mission.answer.required_power_w
    assert quad.spot == "airy"


def _seen(table, angle="optical"):
    return geometry.Geometry(
        angle,
        table.incidence_rad,
        table.magnification,
        table.rotation_rad,
        (table.coupling[:2], table.coupling[2:]),
        table.layout,
        table.actuator_radius_m,
    )


@settings(deadline=None, max_examples=60)
@given(
    st.lists(
        st.sampled_from([0.0, 1.0, -1.0, 0.5, 2e-4, 1e-4]) | st.floats(-2.0, 2.0).map(lambda x: round(x, 9)),
        min_size=4,
        max_size=4,
    ),
    st.sampled_from([0.0, 45.0, 89.0, 89.99, 89.999, 90.0]),
    st.sampled_from(["two-axis", "tripod"]),
)
@example([1.0, 0.0, 0.0, 1.01e-4], 0.0, "two-axis")
@example([1.0, 0.0, 0.0, 0.99e-4], 0.0, "two-axis")
@example([1.0, 1.0, -1.0, -1.0], 0.0, "tripod")
@example([1e-4, 0.0, 0.0, 1.0], 89.999, "two-axis")
@example([1e-12, 0.0, 0.0, 1.0], 90.0, "two-axis")
def test_a_geometry_is_taken_exactly_where_its_decoupling_exists(coupling, degrees, layout):
    given_keys = {"layout": layout, "incidence": f"{degrees} deg", "magnification": 3.0, "rotation": "30 deg"}
    given_keys |= {"coupling": coupling, "travel_angle": "optical"}
    given_keys |= {"actuator_radius": "10 mm"} if layout == "tripod" else {}
    rows = (tuple(coupling[:2]), tuple(coupling[2:]))
    try:
        radius = 0.01 if layout == "tripod" else None
        made = geometry.Geometry("optical", math.radians(degrees), 3.0, math.radians(30.0), rows, layout, radius)
        geometry.outputs_matrix(made)
        decouples = True
    except (ValueError, np.linalg.LinAlgError):
        decouples = False
    try:
        table = GeometryTable.model_validate(given_keys)
    except ValueError as error:
        assert not decouples, error
        return
    assert decouples
    np.testing.assert_allclose(geometry.line_of_sight_matrix(_seen(table)), geometry.line_of_sight_matrix(made))


def test_coupling_and_incidence_are_told_apart_where_a_geometry_is_singular(load):
    for coupling, incidence, keys in [
        ("[1.0, 1.0, 1.0, 1.0]", '"0 deg"', {"coupling"}),
        ("[1.0, 0.0, 0.0, 1.0]", '"89.999 deg"', {"incidence"}),
        ("[1.0, 1.0, 1.0, 1.0]", '"89.999 deg"', {"coupling", "incidence"}),
        ("[1.0, 0.0, 0.0, 0.01]", '"89.9 deg"', {"coupling"}),  # each by itself would do
    ]:
        with pytest.raises(MissionError) as refused:
            load(edited(("geometry.coupling", coupling), ("geometry.incidence", incidence)))
        assert {fault.key.rpartition(".")[2] for fault in refused.value.faults} == keys


def test_a_geometry_is_singular_here_where_it_is_there():
    assert fine_pointing_table.WORST_CONDITION == geometry.WORST_CONDITION


# ---- one value wrong
ONE_WRONG = [
    ("rate", "5000", "number without a unit", 'rate = "5000 Hz"'),
    ("rate", '"0 Hz"', "not above 0 Hz", "above 0 Hz"),
    ("delay", '"190 us"', "no whole number of plant_step", "would do"),
    ("delay", '"-20 us"', "below 0 s", "at least 0 s"),
    ("plant_step", '"30 us"', "does not divide the control period 1 / fine_pointing.rate (200 µs)", "would do"),
    ("plant_step", '"0.1999 ns"', "more than 1000000 times into the control period or the delay", "nearer to 1 /"),
    ("plant_step", '"1e-20 s"', "more than 1000000 times", "nearer to 1 / fine_pointing.rate"),
    ("amplifier_bandwidth", '"0 Hz"', "not above 0 Hz", "above 0 Hz"),
    ("drive_resolution", '"-1 mV"', "below 0 V", 'drive_resolution = "5 mV"'),
    ("reference_filter", '"2.5 kHz"', "not below half of fine_pointing.rate (2.5 kHz)", "would do"),
    ("modulus_margin", "0", "not above 0 and below 1", "modulus_margin = 0.5"),
    ("modulus_margin", "1", "not above 0 and below 1", "modulus_margin = 0.5"),
    ("modulus_margin", '"0.5"', "not a plain number", "without quotes"),
    ("quantile", "99.7", "not above 0 and below 1", "quantile = 0.5"),
    ("quantile", "nan", "not a finite number", "quantile = "),
    ("runs", "0", "below 1", "from 1 to 100000; for example runs = 2"),
    ("runs", "100001", "above 100000", "from 1 to 100000"),
    ("runs", "64.0", "not a whole number", "a whole number without quotes"),
    ("runs", "true", "not a whole number", "a whole number without quotes"),
    ("runs", '"64"', "not a whole number", "without quotes"),
    ("seed", "-1", "below 0", "from 0 to 9223372036854775807"),
    ("seed", "9223372036854775808", "above 9223372036854775807", "from 0 to 9223372036854775807"),
    ("duration", "10", "number without a unit", 'duration = "10 s"'),
    ("duration", '"1e8 s"', "more than 100000000 samples of fine_pointing.rate", "would do"),
    ("duration", '"20000.0002 s"', "more than 100000000 samples of fine_pointing.rate", "would do"),
    ("settle", '"2 s"', "not less than duration (2 s)", "would do"),
    ("settle", '"1.99999 s"', "leaves no control sample behind settle", "would do"),
    ("geometry.layout", '"tripods"', "none of the choices", 'layout = "tripod"'),
    ("geometry.incidence", '"90 deg"', "grazes the mirror", "would do"),
    ("geometry.incidence", '"-1 deg"', "below 0 deg", 'incidence = "5 deg"'),
    ("geometry.magnification", "0", "not above 0", "above 0"),
    ("geometry.magnification", '"10"', "not a plain number", "without quotes"),
    ("geometry.rotation", "90", "number without a unit", 'rotation = "90 deg"'),
    ("geometry.coupling", "[1.0, 0.0, 1.0]", "has 3 items", "would do"),
    ("geometry.coupling", "[1.0, 1.0, 2.0, 2.0]", "is singular: it moves the line of sight over 10000 times", "would"),
    ("geometry.coupling", "[0.0, 0.0, 0.0, 0.0]", "is singular", "would do"),
    ("geometry.coupling", '["1", 0.0, 0.0, 1.0]', "item 1", "a list"),
    ("geometry.actuator_radius", '"10 mm"', 'does not belong to layout = "two-axis"', 'or layout = "tripod"'),
    ("geometry.travel_angle", '"electrical"', "none of the choices", 'travel_angle = "optical"'),
    ("vibration.spectrum", '"olympic"', "none of the choices", 'spectrum = "olympus"'),
    ("vibration.convention", '"both"', "none of the choices", 'convention = "radial" or convention = "per-axis"'),
    ("vibration.level", '"160 urad^2/Hz"', 'does not belong to spectrum = "olympus"', 'or spectrum = "first-order"'),
    ("vibration.level", '"160 urad"', "another kind of quantity", 'level = "5 urad^2/Hz"'),
    ("vibration.level", '"160 rad^2/Hz"', "is above 1 rad^2/Hz", "at most 1 rad^2/Hz"),
    ("vibration.corner", '"1 Hz"', 'does not belong to spectrum = "olympus"', 'or spectrum = "first-order"'),
    ("vibration.edges", '["0 Hz", "1 Hz"]', 'does not belong to spectrum = "olympus"', 'or spectrum = "bands"'),
    ("vibration.rms", '["1 urad"]', 'does not belong to spectrum = "olympus"', 'or spectrum = "bands"'),
    ("vibration.rms", '["0 urad"]', "item 1", "above 0 rad"),
    ("vibration.file", '"a.csv"', 'does not belong to spectrum = "olympus"', 'or spectrum = "table"'),
    ("vibration.file", '""', "is empty", "text in quotes"),
    ("body.error", '"-1 urad"', "below 0 rad", 'error = "5 urad"'),
    ("body.sigmas", "0", "not above 0", "above 0"),
    ("body.bandwidth", '"12.5 kHz"', "not below half of 1 / fine_pointing.plant_step (12.5 kHz)", "would do"),
    ("body.convention", '"3-sigma"', "none of the choices", 'convention = "per-axis"'),
    ("optical_sensor.noise", None, "is missing, and so is the table quad_cell", "would do"),
    ("optical_sensor.field_of_view", '"0 mrad"', "not above 0 rad", "above 0 rad"),
    ("optical_sensor.rate", '"10 kHz"', "above fine_pointing.rate (5 kHz)", "would do"),
    ("optical_sensor.rate", '"3 kHz"', "does not divide fine_pointing.rate (5 kHz)", 'rate = "2.5 kHz" would do'),
    ("optical_sensor.rate", '"2 kHz"', "does not divide", 'rate = "1.66666666667 kHz" would do'),
    ("optical_sensor.rate", '"1 mHz"', "less than fine_pointing.rate (5 kHz) divided by 1000000", "would do"),
    ("optical_sensor.delay", '"90 us"', "no whole number of plant_step", 'delay = "80 µs" would do'),
    ("optical_sensor.rate", '"4.999 mHz"', "less than fine_pointing.rate (5 kHz) divided by 1000000", "would do"),
    ("optical_sensor.delay", '"40.00004 s"', "more than 1000000 times fine_pointing.plant_step", "would do"),
    ("optical_sensor.delay", '"1e9 s"', "more than 1000000 times fine_pointing.plant_step", "would do"),
    ("strain_gauge.noise", "0.1", "number without a unit", '"0.1 urad"'),
    ("reference.point_ahead", '"-71 urad"', "below 0 rad", "at least 0 rad"),
    ("reference.point_ahead_on_mirror", '"yes"', "neither true nor false", "point_ahead_on_mirror = true"),
    ("reference.point_ahead_on_mirror", "1", "neither true nor false", "without quotes"),
    ("reference.point_ahead_on_mirror", None, "is missing", "true or false, without quotes"),
    ("reference.line_of_sight_rate", '"255 urad"', "another kind", 'line_of_sight_rate = "5 urad/s"'),
    ("reference.rate_feedforward", "99", "above 1", "at most 1"),
]  # fmt: skip


@pytest.mark.parametrize(("key", "value", "reason", "expected"), ONE_WRONG)
def test_one_bad_value_is_one_fault_and_what_would_do_does(refuse, load, key, value, reason, expected):
    text = edited((key, value))
    fault = refuse(text)
    assert fault.key == f"fine_pointing.{key}" or (key, fault.key) == ("settle", "fine_pointing.duration")
    assert value is None or value.startswith("[") or fault.value == value or fault.key.endswith("duration")
    assert reason in fault.reason
    assert expected in fault.expected
    assert fault.line
    if "would do" in fault.expected:
        _check_advice(load, text, fault)


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("duration", '"20000 s"'),
        ("settle", '"0 s"'),
        ("settle", '"1.9998 s"'),
        ("reference_filter", '"2.499 kHz"'),
        ("delay", '"40 s"'),
        ("delay", '"0 s"'),
        ("plant_step", '"200 us"'),
        ("plant_step", '"0.2 ns"'),
        ("optical_sensor.rate", '"5 mHz"'),
        ("optical_sensor.delay", '"40 s"'),
        ("body.bandwidth", '"12.49 kHz"'),
        ("reference.rate_feedforward", "1.0"),
        ("reference.rate_feedforward", "0.0"),
    ],
)
def test_what_meets_a_limit_of_the_table_is_taken(load, key, value):
    assert isinstance(load(edited((key, value))), FinePointing)


@pytest.mark.parametrize(
    ("changes", "key"),
    [
        ([("body.bandwidth", '"10 kHz"')], "body.bandwidth"),
        (
            [
                ("vibration.spectrum", '"first-order"'),
                ("vibration.level", '"1 urad^2/Hz"'),
                ("vibration.corner", '"10 kHz"'),
            ],
            "vibration.corner",
        ),
        (
            [
                ("vibration.spectrum", '"bands"'),
                ("vibration.edges", '["1 Hz", "10 kHz"]'),
                ("vibration.rms", '["1 urad"]'),
            ],
            "vibration.edges",
        ),
        ([("wheels.speed", '"5 kHz"')], "wheels.speed"),
    ],
)
def test_what_stands_at_half_the_rate_of_the_plant_is_refused_and_a_hertz_below_it_taken(refuse, load, changes, key):
    """A plant step of 50 us, of which half the rate is 10 kHz to the last bit."""
    text = uncommented("fine_pointing.wheels")
    fault = refuse(edited(("plant_step", '"50 us"'), *changes, text=text))
    assert fault.key == f"fine_pointing.{key}"
    assert "not below half of 1 / fine_pointing.plant_step (10 kHz)" in fault.reason
    below = [(name, value.replace("10 kHz", "9.999 kHz").replace('"5 kHz"', '"4.999 kHz"')) for name, value in changes]
    assert isinstance(load(edited(("plant_step", '"50 us"'), *below, text=text)), FinePointing)


def test_an_incidence_along_the_mirror_is_refused_whatever_its_coupling(refuse):
    fault = refuse(edited(("geometry.incidence", '"90 deg"'), ("geometry.coupling", "[6e-17, 0.0, 0.0, 1.0]")))
    assert (fault.key, fault.reason[:17]) == ("fine_pointing.geometry.incidence", "grazes the mirror")


def _check_advice(load, text, fault):
    """The lines that the advice names make a good file."""
    table = fault.key.rpartition(".")[0].removeprefix("fine_pointing").lstrip(".")
    named = re.findall(r'(\w+) = ("[^"]*"|\[[^\]]*\])', fault.expected.partition("would do")[0])
    assert named, fault.expected
    changes = [(f"{table}.{name}".lstrip("."), value) for name, value in named]
    assert isinstance(load(edited(*changes, text=text)), FinePointing)


@pytest.mark.parametrize(
    ("changes", "key", "reason"),
    [
        ([("spectrum", '"first-order"'), ("corner", '"1 Hz"')], "level", 'spectrum = "first-order" needs it'),
        ([("spectrum", '"first-order"'), ("level", '"1 urad^2/Hz"')], "corner", 'spectrum = "first-order" needs it'),
        ([("spectrum", '"bands"'), ("edges", '["0 Hz", "1 Hz"]')], "rms", 'spectrum = "bands" needs it'),
        ([("spectrum", '"bands"'), ("rms", '["1 urad"]')], "edges", 'spectrum = "bands" needs it'),
        ([("spectrum", '"table"')], "file", 'spectrum = "table" needs it'),
        ([("spectrum", '"first-order"'), ("level", '"1 urad^2/Hz"'), ("corner", '"12.5 kHz"')], "corner", "not below"),
        ([("spectrum", '"bands"'), ("edges", '["1 Hz"]'), ("rms", '["1 urad"]')], "edges", "has 1 item"),
    ],
)
def test_a_spectrum_that_lacks_a_key_names_a_line_that_would_do(refuse, load, changes, key, reason):
    text = edited(*((f"vibration.{name}", value) for name, value in changes))
    fault = refuse(text)
    assert fault.key == f"fine_pointing.vibration.{key}"
    assert reason in fault.reason
    assert "would do" in fault.expected
    _check_advice(load, text, fault)


@pytest.mark.parametrize(
    ("edges", "rms", "key", "reason", "expected"),
    [
        ('["0 Hz", "1 Hz"]', '["1 urad", "2 urad"]', "rms", "has 2 items where edges has 2", "1 item, for the one"),
        ('["0 Hz", "1 Hz", "2 Hz"]', '["1 urad"]', "rms", "has 1 item where edges has 3", "2 items, one for each band"),
        ('["1 Hz", "0 Hz"]', '["1 urad"]', "edges", "does not rise", "rising"),
        ('["-1 Hz", "0 Hz"]', '["1 urad"]', "edges", "item 1", "at least 0 Hz"),
        ('["1 Hz", "12.5 kHz"]', '["1 urad"]', "edges", "reaches 12.5 kHz, not below half of", "edges that end below"),
        ('["1 Hz", "30 kHz"]', '["1 urad"]', "edges", "reaches 30 kHz, not below half of 1 / fine_pointing.plant_step",
         "edges that end below 12.5 kHz, at 2.5 kHz for example"),
    ],
)  # fmt: skip
def test_bands_have_edges_that_rise_and_an_rms_each(refuse, edges, rms, key, reason, expected):
    changes = [("vibration.spectrum", '"bands"'), ("vibration.edges", edges), ("vibration.rms", rms)]
    fault = refuse(edited(*changes))
    assert fault.key == f"fine_pointing.vibration.{key}"
    assert reason in fault.reason
    assert expected in fault.expected


@pytest.mark.parametrize(
    ("key", "value", "reason", "expected"),
    [
        ("speed", '"0 Hz"', "not above 0 Hz", "above 0 Hz"),
        (
            "speed",
            '"6.25 kHz"',
            "puts harmonic 2 at 12.5 kHz, not below half of 1 / fine_pointing.plant_step",
            "would do",
        ),
        ("speed", '"20 kHz"', "puts harmonic 2 at 40 kHz, not below half of 1 / fine_pointing.plant_step", "would do"),
        ("harmonics", "[1.0, 0.0]", "item 2", "above 0"),
        ("harmonics", "[1.0]", "has 2 items where harmonics has 1", "1 of them, one coefficient for each harmonic"),
        ("coefficients", '["1 nrad/Hz^2"]', "has 1 item where harmonics has 2", "2 of them"),
        ("coefficients", '["1 nrad/Hz^2", "1 nrad/Hz"]', "item 2", "squared frequency"),
        ("convention", '"total"', "none of the choices", 'convention = "radial"'),
        ("convention", None, "is missing", 'convention = "radial"'),
    ],
)
def test_a_wheel_has_a_coefficient_for_each_harmonic_below_the_plants_rate(refuse, load, key, value, reason, expected):
    text = edited((f"wheels.{key}", value), text=uncommented("fine_pointing.wheels"))
    fault = refuse(text)
    counts = key == "harmonics" and "where" in reason
    assert fault.key == f"fine_pointing.wheels.{'coefficients' if counts else key}"
    assert reason in fault.reason
    assert expected in fault.expected
    if "would do" in fault.expected:
        _check_advice(load, text, fault)


@pytest.mark.parametrize(
    ("key", "value", "reason", "expected"),
    [
        ("responsivity", '"1 V/W"', "another kind", 'responsivity = "5 A/W"'),
        ("background_power", '"-1 pW"', "below 0 W", "at least 0 W"),
        ("dark_current", '"1 nW"', "another kind", 'dark_current = "5 nA"'),
        ("thermal_noise", '"1 pA^2/Hz"', "another kind", 'thermal_noise = "5 pA/sqrt(Hz)"'),
        ("thermal_noise", '"1 pA/rtHz"', 'no unit is called "rtHz"', 'thermal_noise = "5 pA/sqrt(Hz)"'),
        ("received_power", '"0 pW"', "not above 0 W", "above 0 W"),
        ("spot", '"gaussian"', "none of the choices", 'spot = "airy"'),
    ],
)
def test_a_quad_cell_is_described_in_the_units_of_its_data_sheet(refuse, key, value, reason, expected):
    text = edited(("optical_sensor.noise", None), text=uncommented("fine_pointing.optical_sensor.quad_cell"))
    fault = refuse(edited((f"optical_sensor.quad_cell.{key}", value), text=text))
    assert fault.key == f"fine_pointing.optical_sensor.quad_cell.{key}"
    assert reason in fault.reason
    assert expected in fault.expected


def test_the_sensors_noise_is_said_once(refuse):
    fault = refuse(uncommented("fine_pointing.optical_sensor.quad_cell"))
    assert (fault.key, fault.value) == ("fine_pointing.optical_sensor.noise", '"1 urad"')
    assert "stands beside the table quad_cell" in fault.reason
    assert "one of the two removed" in fault.expected


def test_a_tripod_without_a_radius_names_one_that_would_do(refuse, load):
    text = edited(("geometry.layout", '"tripod"'))
    fault = refuse(text)
    assert (fault.key, fault.reason) == (
        "fine_pointing.geometry.actuator_radius", 'is missing, and layout = "tripod" needs it'
    )  # fmt: skip
    _check_advice(load, text, fault)


def test_faults_of_several_tables_are_told_at_once(load):
    text = edited(("reference_filter", '"5 kHz"'), ("delay", '"190 us"'), ("optical_sensor.rate", '"3 kHz"'))
    with pytest.raises(MissionError) as refused:
        load(text.replace('distance = "44000 km"', "distance = 44000", 1))
    assert {fault.key for fault in refused.value.faults} == {
        "fine_pointing.reference_filter", "fine_pointing.delay", "fine_pointing.optical_sensor.rate", "beacon.distance"
    }  # fmt: skip


def test_an_unknown_key_is_shown_with_the_nearest(refuse):
    fault = refuse(TEXT.replace("modulus_margin = 0.5", "modulus_margins = 0.5"))
    assert (fault.key, fault.nearest) == ("fine_pointing.modulus_margins", "modulus_margin")


@pytest.mark.parametrize(("rate", "readings"), [("5 kHz", 1), ("2.5 kHz", 2), ("1.66666666667 kHz", 3), ("1 Hz", 5000)])
def test_a_rate_that_divides_is_taken_and_is_a_sensors(load, rate, readings):
    table = load(edited(("optical_sensor.rate", f'"{rate}"'), ("optical_sensor.delay", '"40 us"')))
    optical = table.optical_sensor
    made = sensor.optical_sensor(
        optical.noise_rad,
        optical.field_of_view_rad,
        rate_hz=optical.rate_hz,
        delay_s=optical.delay_s,
        control_rate_hz=table.rate_hz,
        plant_step_s=table.plant_step_s,
    )
    assert (made.every, made.delay_steps) == (readings, 1)


OWN = load_mission(SHIPPED).mission.fine_pointing


@settings(deadline=None)
@given(st.floats(1e-3, 6e3))
def test_a_rate_is_refused_exactly_where_a_sensor_refuses_it(rate_hz):
    sensed = OWN.optical_sensor.model_copy(update={"rate_hz": rate_hz})
    told = list(OWN.model_copy(update={"optical_sensor": sensed}).problems())
    clocks = {"rate_hz": rate_hz, "delay_s": 0.0, "control_rate_hz": 5e3, "plant_step_s": 40e-6}
    try:
        sensor.optical_sensor(1e-6, 2e-3, **clocks)
    except ValueError:
        assert [problem.key for problem in told] == ["optical_sensor.rate"]
    else:
        assert not told or rate_hz < 5e-3


def test_extreme_numbers_are_refused_and_raise_nothing_else(load):
    for key in ("rate", "plant_step", "optical_sensor.rate", "optical_sensor.delay", "duration", "delay"):
        unit = "Hz" if "rate" in key else "s"
        for number in ("1e-320", "1e-300", "1e11", "1e300"):
            with pytest.raises(MissionError):
                load(edited((key, f'"{number} {unit}"')))


# ---- schema
def test_the_schema_has_the_kinds_of_plain_values():
    tables = mission_schema()["$defs"]
    table = tables["FinePointing"]["properties"]
    rule = {"title": "Runs", "type": "integer", "minimum": 1, "maximum": 100_000}
    assert rule == {key: value for key, value in table["runs"].items() if key != "description"}
    assert (table["seed"]["type"], table["seed"]["maximum"]) == ("integer", 2**63 - 1)
    assert (table["quantile"]["exclusiveMinimum"], table["quantile"]["exclusiveMaximum"]) == (0.0, 1.0)
    assert tables["ReferenceTable"]["properties"]["point_ahead_on_mirror"]["type"] == "boolean"
    assert tables["VibrationTable"]["properties"]["spectrum"]["enum"] == ["olympus", "first-order", "bands", "table"]
    level = next(rule for rule in tables["VibrationTable"]["properties"]["level"]["anyOf"] if "x-si-unit" in rule)
    assert (level["x-si-unit"], bool(re.search(level["pattern"], "160 urad^2/Hz"))) == ("rad^2/Hz", True)
    noise = tables["QuadCellTable"]["properties"]["thermal_noise"]
    assert (noise["x-si-unit"], noise["examples"]) == ("A/sqrt(Hz)", ["5 pA/sqrt(Hz)"])
    assert not {"wheels", "strain_gauge"} & set(tables["FinePointing"]["required"])
    for name in ("FinePointing", "GeometryTable", "VibrationTable", "WheelsTable", "BodyTable", "ReferenceTable"):
        assert tables[name]["additionalProperties"] is False


@pytest.mark.parametrize("harmonics", ["[2000.0, 1.0]", "[1.0, 2000.0]"])
def test_the_highest_harmonic_of_a_wheel_is_judged_wherever_it_stands(refuse, harmonics):
    fault = refuse(edited(("wheels.harmonics", harmonics), text=uncommented("fine_pointing.wheels")))
    assert fault.key == "fine_pointing.wheels.speed"
    assert "puts harmonic 2000 at " in fault.reason


def clocked(**changes):
    """A loop of 6.25 kHz in steps of 40 us, in which all fits."""
    given = {
        "rate_hz": 6250.0,
        "delay_s": 80e-6,
        "plant_step_s": 40e-6,
        "reference_filter_hz": 3124.0,
        "duration_s": 2.5,
        "settle_s": 0.75,
        "optical_sensor": SimpleNamespace(rate_hz=1250.0, delay_s=120e-6),
        "vibration": SimpleNamespace(corner_hz=None, edges_hz=None),
        "body": SimpleNamespace(bandwidth_hz=0.2),
        "wheels": None,
    }
    return made(FinePointing, **given | changes)


ALL_OF_A_LOOP = {
    "nothing": (
        lambda: clocked().problems(),
        """

        """,
    ),
    "a mirror alone with a radius, that grazes and is singular besides": (
        lambda: made(
            GeometryTable,
            layout="two-axis",
            actuator_radius_m=0.01,
            coupling=(1.0, 2.0, 2.0, 4.0),
            incidence_rad=math.pi / 2,
        ).problems(),
        """
        actuator_radius does not belong to layout = "two-axis": expected this line removed, or layout = "tripod";
        incidence grazes the mirror, which then moves the line of sight over 10000 times less in one direction than
        across it: expected incidence = "45 deg" would do; coupling is singular: it moves the line of sight over
        10000 times less in one direction than across it: expected coupling = [1.0, 0.0, 0.0, 1.0] would do
        """,
    ),
    "a tripod without one that grazes": (
        lambda: made(
            GeometryTable, layout="tripod", coupling=(1.0, 0.0, 0.0, 1.0), incidence_rad=math.pi / 2 - 0.9e-4
        ).problems(),
        """
        actuator_radius is missing, and layout = "tripod" needs it: expected actuator_radius = "10 mm" would do;
        incidence grazes the mirror, which then moves the line of sight over 10000 times less in one direction than
        across it: expected incidence = "45 deg" would do
        """,
    ),
    "a coupling of five": (
        lambda: made(GeometryTable, layout="two-axis", coupling=(1.0, 0.0, 0.0, 1.0, 1.0)).problems(),
        """coupling has 5 items: expected four, row by row: coupling = [1.0, 0.0, 0.0, 1.0] would do""",
    ),
    "a spectrum by bands with what others have": (
        lambda: made(
            VibrationTable,
            spectrum="bands",
            level_rad2_hz=0.0,
            file="a.csv",
            edges_hz=(0.0, 1.0, 2.0, 4.0),
            rms_rad=(1e-6,),
        ).problems(),
        """
        level does not belong to spectrum = "bands": expected this line removed, or spectrum = "first-order"; file
        does not belong to spectrum = "bands": expected this line removed, or spectrum = "table"; rms has 1 item
        where edges has 4: expected 3 items, one for each band between the edges
        """,
    ),
    "a spectrum of a table without it": (
        lambda: made(VibrationTable, spectrum="table", corner_hz=1.0, rms_rad=(1e-6,)).problems(),
        """
        corner does not belong to spectrum = "table": expected this line removed, or spectrum = "first-order"; rms
        does not belong to spectrum = "table": expected this line removed, or spectrum = "bands"; file is missing,
        and spectrum = "table" needs it: expected file = "spectrum.csv" would do
        """,
    ),
    "a spectrum of one edge": (
        lambda: made(VibrationTable, spectrum="bands", edges_hz=(0.0,), rms_rad=(1e-6, 2e-6)).problems(),
        """
        edges has 1 item, and a band has two edges: expected two or more: edges = ["0 Hz", "1 Hz"] and rms = ["8.6
        urad"] would do
        """,
    ),
    "a spectrum of one band with three values": (
        lambda: made(VibrationTable, spectrum="bands", edges_hz=(0.0, 8.0), rms_rad=(1e-6, 2e-6, 3e-6)).problems(),
        """rms has 3 items where edges has 2: expected 1 item, for the one band between the edges""",
    ),
    "a spectrum of first order with nothing": (
        lambda: made(VibrationTable, spectrum="first-order").problems(),
        """
        level is missing, and spectrum = "first-order" needs it: expected level = "160 urad^2/Hz" would do; corner
        is missing, and spectrum = "first-order" needs it: expected corner = "1 Hz" would do
        """,
    ),
    "a wheel with one coefficient": (
        lambda: made(WheelsTable, harmonics=(1.0, 2.0, 5.2), coefficients_rad_hz2=(1e-9,)).problems(),
        """
        coefficients has 1 item where harmonics has 3: expected 3 of them, one coefficient for each harmonic
        """,
    ),
    "a wheel with three coefficients": (
        lambda: made(WheelsTable, harmonics=(1.0, 5.2), coefficients_rad_hz2=(1e-9, 2e-9, 3e-9)).problems(),
        """
        coefficients has 3 items where harmonics has 2: expected 2 of them, one coefficient for each harmonic
        """,
    ),
    "a misalignment about three axes and one": (
        lambda: made(MisalignmentTable, offset_rad=(0.0, 0.0, 0.0), drift_rad_s=(0.0,)).problems(),
        """
        offset has 3 items: expected two, for x and y: offset = ["1 urad", "1 urad"]; drift has 1 item: expected
        two, for x and y: drift = ["1 urad/s", "1 urad/s"]
        """,
    ),
    "a sensor without noise": (
        lambda: made(OpticalSensorTable).problems(),
        """
        noise is missing, and so is the table quad_cell: expected noise = "1 urad" would do, or a table quad_cell
        """,
    ),
    "a sensor with two": (
        lambda: made(OpticalSensorTable, noise_rad=0.0, quad_cell=0).problems(),
        """noise stands beside the table quad_cell: expected one of the two removed""",
    ),
    "a clock whose delays and sensor fall between steps and samples": (
        lambda: clocked(delay_s=95e-6, optical_sensor=SimpleNamespace(rate_hz=1700.0, delay_s=130e-6)).problems(),
        """
        delay is no whole number of plant_step: expected delay = "80 µs" would do; optical_sensor.rate does not
        divide fine_pointing.rate (6.25 kHz): readings would fall between control samples: expected rate = "1.5625
        kHz" would do; optical_sensor.delay is no whole number of plant_step: expected delay = "120 µs" would do
        """,
    ),
    "a step that does not divide the period": (
        lambda: clocked(
            plant_step_s=45e-6, delay_s=90e-6, optical_sensor=SimpleNamespace(rate_hz=2600.0, delay_s=135e-6)
        ).problems(),
        """
        plant_step does not divide the control period 1 / fine_pointing.rate (160 µs): expected a whole fraction of
        it: plant_step = "40 µs" would do; optical_sensor.rate does not divide fine_pointing.rate (6.25 kHz):
        readings would fall between control samples: expected rate = "2.08333333333 kHz" would do
        """,
    ),
    "a step that is nothing beside the delay of the sensor": (
        lambda: clocked(
            plant_step_s=320e-12, delay_s=0.0, optical_sensor=SimpleNamespace(rate_hz=6250.0001, delay_s=321e-6)
        ).problems(),
        """
        optical_sensor.rate is above fine_pointing.rate (6.25 kHz): the controller would miss some of its readings:
        expected rate = "6.25 kHz" would do; optical_sensor.delay is more than 1000000 times
        fine_pointing.plant_step: expected a shorter delay: delay = "0 us" would do
        """,
    ),
    "a step that is nothing beside the period": (
        lambda: clocked(plant_step_s=120e-12, optical_sensor=SimpleNamespace(rate_hz=1e-3, delay_s=0.0)).problems(),
        """
        plant_step goes more than 1000000 times into the control period or the delay: expected a step nearer to 1 /
        fine_pointing.rate; optical_sensor.rate is less than fine_pointing.rate (6.25 kHz) divided by 1000000:
        expected a faster sensor: rate = "6.25 kHz" would do
        """,
    ),
    "a run without end": (
        lambda: clocked(duration_s=16001.0).problems(),
        """
        duration is more than 100000000 samples of fine_pointing.rate: expected more runs that are shorter: duration
        = "8000 s" would do
        """,
    ),
    "a run that settles to its end": (
        lambda: clocked(settle_s=2.5).problems(),
        """settle is not less than duration (2.5 s): expected settle = "500 ms" would do""",
    ),
    "a run without a sample behind the settling": (
        lambda: clocked(settle_s=2.49995).problems(),
        """
        duration leaves no control sample behind settle: expected a longer run: duration = "2.82 s" would do
        """,
    ),
    "a long run without a sample behind the settling": (
        lambda: clocked(settle_s=2499.99999, duration_s=2500.0).problems(),
        """
        duration leaves no control sample behind settle: expected a longer run: duration = "2501 s" would do
        """,
    ),
    "a filter and a body that are too fast": (
        lambda: clocked(reference_filter_hz=3125.0, body=SimpleNamespace(bandwidth_hz=12500.0)).problems(),
        """
        body.bandwidth is not below half of 1 / fine_pointing.plant_step (12.5 kHz): expected bandwidth = "2.5 kHz"
        would do; reference_filter is not below half of fine_pointing.rate (3.125 kHz): expected reference_filter =
        "1.25 kHz" would do
        """,
    ),
    "disturbances beyond the steps of the plant": (
        lambda: clocked(
            vibration=SimpleNamespace(corner_hz=13e3, edges_hz=(1.0, 14e3)),
            wheels=SimpleNamespace(speed_hz=250.0, harmonics=(64.0, 2.0, 4.0)),
        ).problems(),
        """
        vibration.corner is not below half of 1 / fine_pointing.plant_step (12.5 kHz): expected corner = "2.5 kHz"
        would do; vibration.edges reaches 14 kHz, not below half of 1 / fine_pointing.plant_step (12.5 kHz):
        expected edges that end below 12.5 kHz, at 2.5 kHz for example; wheels.speed puts harmonic 64 at 16 kHz, not
        below half of 1 / fine_pointing.plant_step (12.5 kHz): expected speed = "39.06 Hz" would do, or without that
        harmonic
        """,
    ),
    "the clock of another table": (
        lambda: clock_problems("control", 4000.0, 33e-6, 10e-6),
        """delay is no whole number of plant_step: expected delay = "30 µs" would do""",
    ),
}


@pytest.mark.parametrize("what", ALL_OF_A_LOOP)
def test_all_that_does_not_fit_in_a_table_of_the_loop_is_told_in_full(what):
    problems, words = ALL_OF_A_LOOP[what]
    assert told(problems()) == one_line(words)


@pytest.mark.parametrize(
    ("coupling", "cosine", "singular"),
    [
        ((1.0, 0.0, 0.0, 1.0), 1.0, False),
        ((1.0, 0.0, 0.0, 1.01e-4), 1.0, False),
        ((1.0, 0.0, 0.0, 0.99e-4), 1.0, True),
        ((1.0, 0.0, 0.0, 2e-4), 0.49, True),
        ((1.0, 0.0, 0.0, 2e-4), 0.51, False),
        ((0.0, 3.0, -2.0, 0.0), 0.5, False),
        ((1.0, 2.0, 2.0, 4.0), 1.0, True),
        ((1.0, 2.0, -2.0, 1.0), 1.1e-4, False),
        ((1.0, 2.0, -2.0, 1.0), 0.9e-4, True),
    ],
)
def test_a_coupling_is_singular_beyond_a_condition_of_ten_thousand(coupling, cosine, singular):
    matrix = np.diag([1.0, cosine]) @ np.array(coupling).reshape(2, 2)
    assert bool(np.linalg.cond(matrix) > 1e4) is singular
    assert fine_pointing_table._singular(coupling, cosine) is singular


def test_a_coupling_that_is_missing_is_shown_as_four_numbers_that_are_taken():
    (annotation,) = fine_pointing_table.Coupling.__metadata__
    assert annotation.example == "[1.0, 0.0, 0.0, 1.0]"
    assert annotation.read(tomllib.loads(f"a = {annotation.example}")["a"]) == (1.0, 0.0, 0.0, 1.0)


@pytest.mark.parametrize(("rate_hz", "delay_s", "told_of"), [
    (1000.0, 1.0, False),  # a million steps of a microsecond
    (1000.0, 1.000001, True),
    (1.0, 0.0, False),
    (0.999999, 0.0, True),
    (0.5, 2.0, True),
])  # fmt: skip
def test_a_step_goes_a_million_times_into_the_period_and_into_the_delay_and_no_more(rate_hz, delay_s, told_of):
    found = [(each.key, each.reason, each.expected) for each in clock_problems("bench", rate_hz, delay_s, 1e-6)]
    reason = "goes more than 1000000 times into the control period or the delay"
    assert found == ([("plant_step", reason, "a step nearer to 1 / bench.rate")] if told_of else [])


@pytest.mark.parametrize("place", range(4))
@pytest.mark.parametrize(("large", "singular"), [(99.0, False), (101.0, True)])
def test_one_large_number_anywhere_in_a_coupling_of_a_small_area_makes_it_singular(place, large, singular):
    """Of condition k the squares of all numbers over the area are k + 1 / k, and here one square is nearly all."""
    numbers = [0.0, 0.0, 0.0, 0.0]
    numbers[place], numbers[3 - place] = large, 1.0 / large
    assert fine_pointing_table._singular(tuple(numbers), 1.0) is singular
    lower = (numbers[0], numbers[1], numbers[2] * 2.0, numbers[3] * 2.0)
    assert fine_pointing_table._singular(lower, 0.5) is singular
    numbers = [1.0, 1.0, 1.0, 1.0]
    numbers[place] = 1.0 + 1e-4  # the area is this much, the squares four
    assert fine_pointing_table._singular(tuple(numbers), 1.0) is True


@pytest.mark.parametrize(("delay_s", "step_s", "key", "better"), [
    (33e-6, 10e-6, "delay", 'delay = "30 µs" would do'),
    (37e-6, 10e-6, "delay", 'delay = "40 µs" would do'),
    (4e-6, 10e-6, "delay", 'delay = "0 s" would do'),
    (37e-6, 60e-6, "plant_step", 'a whole fraction of it: plant_step = "62.5 µs" would do'),
    (37e-6, 65e-6, "plant_step", 'a whole fraction of it: plant_step = "62.5 µs" would do'),
    (0.0, 190e-6, "plant_step", 'a whole fraction of it: plant_step = "250 µs" would do'),
    (0.0, 900e-6, "plant_step", 'a whole fraction of it: plant_step = "250 µs" would do'),
])  # fmt: skip
def test_a_delay_and_a_step_that_miss_whole_steps_to_either_side_are_told_with_the_nearest(
    delay_s, step_s, key, better
):
    (found,) = clock_problems("bench", 4000.0, delay_s, step_s)
    assert (found.key, found.expected) == (key, better)
    assert not list(clock_problems("bench", 4000.0, 125e-6, 62.5e-6))


@pytest.mark.parametrize(("rate_hz", "better"), [
    (2600.0, '"2.08333333333 kHz"'), (4400.0, '"3.125 kHz"'), (4800.0, '"6.25 kHz"'), (5900.0, '"6.25 kHz"'),
    (1600.0, '"1.5625 kHz"'), (1500.0, '"1.5625 kHz"'),
])  # fmt: skip
def test_a_rate_of_a_sensor_that_misses_a_fraction_of_the_loops_to_either_side_is_told_with_the_nearest(
    rate_hz, better
):
    (found,) = clocked(optical_sensor=SimpleNamespace(rate_hz=rate_hz, delay_s=0.0)).problems()
    assert (found.key, found.expected) == ("optical_sensor.rate", f"rate = {better} would do")
