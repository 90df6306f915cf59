"""Linear models of a mission: files and objects carry the same numbers, and forms that hide something are refused."""

import json
import math
import re
import struct
import sys
import zlib
from dataclasses import replace
from fractions import Fraction
from types import SimpleNamespace

import control as python_control
import numpy as np
import pytest
from scipy.io import loadmat, savemat

import designs
import several_axes
from drawn import plain as rounded
from learning_loops import with_plays
from microrad.core import lti
from microrad.export import choice, matrices
from microrad.export.linear_import.matlab import load
from microrad.export.matrices import files as matrices_files
from microrad.export.matrices import forms as matrix_forms
from microrad.export.matrices import structure
from microrad.export.matrices.forms import LinearModel, Port, forms, polynomials
from microrad.export.matrices.models import (
    CONTROLLER,
    LINEAR_PART,
    LOOP,
    MIRROR,
    MIRROR_AT_REST,
    SAMPLED_PLANT,
    _controller,
    _coupled_models,
    _mirror_models,
    _paper_models,
    _pointing_models,
    axis_plant,
)
from microrad.export.matrices.structure import without_copies
from microrad.export.records import ExportError, Origin
from microrad.loop import control, coupled_study
from microrad.loop import sine_run as simulate
from microrad.loop.control.analysis import loop_response
from microrad.loop.pointing_loop.design import design_plant
from microrad.loop.pointing_loop.loop import decoupling
from microrad.mirror import model as mirror
from microrad.mission.file import MissionFile, load_mission
from shipped import SHIPPED

NINE_DIGITS = 1e-9
ROUNDING = 1e-12
STATIC = """
name = "static"
travel = "1 mrad"
composition = "static"
rate_limit = "400 V/s"
bias = "6 V"
drive_min = "0 V"
drive_max = "12 V"

[prandtl_ishlinskii]
thresholds = ["0 V", "1 V"]
weights = ["80 urad/V", "9 urad/V"]
"""


@pytest.fixture(scope="module")
def file():
    return designs.mission()


@pytest.fixture(scope="module")
def tracking():
    return designs.chosen(choice.PID_WITH_INVERSE)


@pytest.fixture(scope="module")
def pointing():
    return designs.chosen("PI + inverse in series")


@pytest.fixture(scope="module")
def gauged():
    return designs.chosen("resonant damping")


@pytest.fixture(scope="module")
def learning(tmp_path_factory):
    """The controller that learns, of the mission with a mirror of plays."""
    return choice.choose(with_plays(tmp_path_factory.mktemp("plays")), "PI + adaptive inverse in series")


MODELS = {}  # what takes seconds is made once


def models(chosen):
    if id(chosen) not in MODELS:
        MODELS[id(chosen)] = matrices.models(choice.source(chosen) if isinstance(chosen, MissionFile) else chosen)
    return MODELS[id(chosen)]


def of(chosen, name):
    (found,) = (each for each in models(chosen) if each.name == name)
    return found


def zero_pole_gain(made, output=0, number=0):
    return forms(made).zero_pole_gain[output][number]


def transfer_function(made, output=0, number=0):
    return forms(made).transfer_function[output][number]


def model(A, B, C, D=None, period_s=0.0, name="made"):
    A, B, C = (np.atleast_2d(np.array(each, dtype=float)) for each in (A, B, C))
    D = np.zeros((C.shape[0], B.shape[1])) if D is None else np.atleast_2d(np.array(D, dtype=float))
    ports = [
        tuple(Port(f"{k}_{i}", "V") for i in range(n))
        for k, n in zip("uyx", (B.shape[1], C.shape[0], len(A)), strict=True)
    ]
    return LinearModel(name, "made by hand", lti.StateSpace(A, B, C, D), period_s, *ports, None)


def grid(period_s, points=200):
    return np.geomspace(1e-5, 0.499, points) / period_s


def response(m, freq_hz):
    return lti.frequency_response(m.system, freq_hz, m.period_s or None)


def difference(found, wanted):
    return np.max(np.abs(found / wanted - 1.0))


def rounding(system, freq_hz, period_s):
    """What an error of eps in each entry of A, and in solving, does to a response, over its largest (Skeel's bound)."""
    z = np.exp(2j * np.pi * freq_hz * period_s)[:, None, None] * np.eye(system.order)
    inverse = np.linalg.inv(z - system.A)
    moved = np.abs(system.C @ inverse) @ (np.abs(z) + np.abs(system.A)) @ np.abs(inverse @ system.B)
    return np.finfo(float).eps * np.max(moved) / np.max(np.abs(system.C @ inverse @ system.B))


# ---------------------------------------------------------------------------------------------------------- the models
@pytest.mark.promise("export-33")
def test_mirror_and_its_linear_part_are_those_of_the_mission(file):
    part, whole = matrices.models(choice.source(file))
    m = file.mission.mirror
    assert (part.name, whole.name) == (LINEAR_PART, MIRROR)
    assert (part.period_s, whole.period_s) == (0.0, 0.0)
    freq = np.geomspace(0.01, 1e5, 200)
    s = 2j * np.pi * freq
    shape = np.polyval(m.linear.numerator, s) / np.polyval(m.linear.denominator, s)
    at = 2j * np.pi * m.linear.normalise_at_hz
    size = abs(np.polyval(m.linear.numerator, at) / np.polyval(m.linear.denominator, at))
    assert difference(response(part, freq)[:, 0, 0], shape / size) < ROUNDING
    assert difference(response(whole, freq)[:, 0, 0], m.bouc_wen.d1_rad_v * shape / size) < ROUNDING
    assert whole.inputs == (Port("drive_v", "V"),) and whole.outputs == (Port("mirror_rad", "rad"),)
    assert whole.origin == Origin(file.mission.name, file.sha256, m.name)
    assert f"{size:.6g}" in part.meaning and "6 V" in whole.meaning


@pytest.mark.promise("export-33")
def test_sampled_plant_of_the_tracking_loop_is_that_of_the_study_with_no_state_too_many(tracking):
    m, setup = of(tracking, SAMPLED_PLANT), tracking.setup
    whole = control.sampled_plant(tracking.mirror, setup.drive, setup.timing)
    freq = grid(m.period_s)
    wanted = lti.frequency_response(whole, freq, setup.timing.period_s)
    assert difference(response(m, freq), wanted) < rounding(whole, freq, setup.timing.period_s)
    assert (m.system.order, whole.order) == (7, 8)  # five modes, the amplifier, and one sample of delay, held twice
    assert m.period_s == setup.timing.period_s == 2e-5


def test_margins_are_exported_in_decibels_and_degrees(pointing):
    known = replace(pointing.tuned.margins, gain_up=2.0, phase_rad=np.pi / 3.0)
    of = choice.flight_controller(replace(pointing, tuned=replace(pointing.tuned, margins=known)))
    told = {name: (round(value, 4), unit) for name, value, unit in of.margins}
    assert (told["gain margin"], told["phase margin"]) == ((6.0206, "dB"), (60.0, "deg"))


@pytest.mark.parametrize("which", ["pointing", "gauged", "learning"])
def test_sampled_plant_of_the_pointing_loop_is_what_its_controller_was_designed_for(which, request):
    chosen = request.getfixturevalue(which)
    m = of(chosen, SAMPLED_PLANT)
    freq = grid(m.period_s)
    plant = design_plant(chosen.scene.axis)
    wanted = lti.frequency_response(plant.system, freq, plant.period_s)[:, :, 0]
    if which != "gauged":
        path = chosen.scene.table.reference_filter_hz
        w, T = 2.0 * np.pi * path, plant.period_s
        Ad, Bd = lti.zero_order_hold(np.array([[0.0, 1.0], [-w * w, -2.0 * w]]), np.array([[0.0], [w * w]]), T)
        filtered = lti.StateSpace(Ad, Bd, Ad[:1], Bd[:1])
        wanted = wanted * lti.frequency_response(filtered, freq, T)[:, :, 0]
    found = response(m, freq)[:, :, 0]
    known = 1e3 * 2.0**-lti.DESIGN_BITS  # to that the plant of a design is rounded; its slowest mode lasts 1e3 samples
    assert difference(found[:, 0], -wanted[:, control.RESIDUAL]) < known
    assert difference(found[:, 1], wanted[:, control.OPTICAL]) < known
    assert difference(found[:, 2], wanted[:, control.GAUGE]) < known
    assert [p.name for p in m.outputs] == ["line_of_sight_rad", "optical_error_rad", "gauge_rad"]
    assert m.system.order < plant.system.order
    assert ("reference filter" in m.meaning) == (which != "gauged")


def test_controller_is_the_one_that_flies(pointing):
    m, flies = of(pointing, CONTROLLER), choice.flight_controller(pointing)
    assert all(np.array_equal(getattr(m.system, key), getattr(flies.system, key)) for key in "ABCD")
    assert np.array_equal(m.anti_windup, flies.anti_windup) and m.anti_windup.any()
    assert m.period_s == flies.period_s > 0.0
    assert [p.name for p in m.inputs] == [f"{n}_{i}" for n in ("optical_error_rad", "reference_rad") for i in (0, 1)]
    assert [(p.name, p.unit) for p in m.outputs] == [
        (f"{n}_{i}", u)
        for n, u in (("command_v", "V"), ("target_rad", "rad"), ("target_rate_rad_s", "rad/s"))
        for i in (0, 1)
    ]
    assert len(m.states) == m.system.order


def test_one_controller_without_an_inverse_has_commands_alone(gauged):
    m = of(gauged, CONTROLLER)
    assert [p.name for p in m.outputs] == ["command_v_0", "command_v_1"]
    assert [p.name for p in m.inputs][2:] == ["gauge_rad_0", "gauge_rad_1"]
    assert "inverse" not in m.meaning


@pytest.mark.promise("export-21")
def test_one_that_learns_has_the_errors_of_its_readings_beside_its_targets(learning):
    m, flies = of(learning, CONTROLLER), choice.flight_controller(learning)
    assert all(np.array_equal(getattr(m.system, key), getattr(flies.system, key)) for key in "ABCD")
    kinds = {"command_v": "V", "target_rad": "rad", "target_rate_rad_s": "rad/s", "unexpected_error_rad": "rad"}
    assert [(p.name, p.unit) for p in m.outputs] == [(f"{n}_{i}", u) for n, u in kinds.items() for i in (0, 1)]
    assert [p.name for p in m.inputs][2:4] == ["gauge_rad_0", "gauge_rad_1"]
    assert "learns from the readings' errors" in m.meaning
    slowly = response(m, np.array([1e-3]))[0]
    np.testing.assert_allclose(slowly[6:, 2:4], np.eye(2), atol=1e-9)  # a reading that nothing made expect is an error
    np.testing.assert_allclose(slowly[6:, :2], -slowly[2:4, :2], rtol=1e-5)  # and a target makes expect itself


def test_target_by_difference_has_no_rate(tracking):
    assert [p.name for p in of(tracking, CONTROLLER).outputs] == ["command_v_0", "target_rad_0"]


@pytest.mark.promise("export-21", "export-33")
@pytest.mark.parametrize("which", ["tracking", "pointing", "gauged", "learning"])
def test_python_control_has_the_response_of_the_loop(which, request):
    """The exported object against the loop that margins are taken of, and against our own evaluation."""
    chosen = request.getfixturevalue(which)
    m = of(chosen, LOOP)
    freq = grid(m.period_s)
    assert freq.size == 200
    theirs = matrices.to_control(m)(np.exp(2j * np.pi * freq * m.period_s))
    assert difference(theirs, response(m, freq)[:, 0, 0]) < NINE_DIGITS
    if which == "tracking":
        whole = simulate.sampled_loop(chosen.mirror, chosen.setup)
        wanted = lti.frequency_response(whole, freq, m.period_s)[:, 0, 0]
    else:
        plant = design_plant(chosen.scene.axis) if which == "gauged" else axis_plant(chosen)
        wanted = loop_response(plant, chosen.tuned.controller, freq)
    assert difference(theirs, wanted) < NINE_DIGITS
    assert np.min(np.abs(1.0 + theirs)) < 1.0 < np.max(np.abs(theirs))


def test_static_mirror_has_no_linear_part(tmp_path):
    path = tmp_path / "static.toml"
    path.write_text(STATIC, encoding="utf-8")
    file = load_mission(SHIPPED, path)
    (m,) = matrices.models(choice.source(file))
    assert m.name == MIRROR
    assert m.system.order == 0 and m.system.D.item() == pytest.approx(89e-6, rel=1e-15)
    matrices.write_mat([m], tmp_path / "static.mat")
    same(m, load(tmp_path / "static.mat")["mirror"].fields)
    assert matrices.to_control(m)(0.0) == m.system.D.item()


@pytest.mark.promise("export-33")
def test_a_chosen_controller_brings_its_plant_and_its_loop(file, tracking):
    assert [each.name for each in models(file)] == ["linear_part", "mirror"]
    names = ["linear_part", "mirror", "sampled_plant", "controller", "loop"]
    assert [each.name for each in models(tracking)] == names


# --------------------------------------------------------------------------------------------------------- several axes
@pytest.fixture(scope="module")
def plate():
    return designs.of_three_actuators()


def answer_of_plate(own, gains, freq_hz):
    """Outputs over drives of the plant form, its equations solved for x, q and y at each frequency."""
    n, m, e = own.A.shape[0], own.actuators, len(gains)
    found = []
    for s in 2j * np.pi * freq_hz:
        unknown = np.block([[s * np.eye(n) - own.A, -own.E * gains], [-own.F, np.eye(e)]])
        x, q = np.split(np.linalg.solve(unknown, np.vstack([own.B, own.G]).astype(complex)), [n])
        found.append(own.C @ x + own.D + (own.K * gains) @ q)
    assert found[0].shape == (own.axes, m)
    return np.array(found)


@pytest.mark.promise("export-34")
def test_a_mirror_of_several_axes_goes_out_at_its_slow_gain_and_as_it_is_about_rest(plate):
    own, freq = plate.scene.mirror.mirror, np.geomspace(1.0, 1e4, 60)
    slow, rest = of(plate, MIRROR), of(plate, MIRROR_AT_REST)
    for made, gains in ((slow, [0.1] * 3), (rest, [0.0] * 3)):  # all plays slide, and none but that without threshold
        found, wanted = response(made, freq), answer_of_plate(own, np.array(gains), freq)
        assert np.max(np.abs(found - wanted)) < NINE_DIGITS * np.max(np.abs(wanted))
        assert made.period_s == 0.0 and "50 V" in made.meaning and made.origin.mirror == own.name
    assert np.max(np.abs(response(slow, freq) - response(rest, freq))) > 0.1 * np.max(np.abs(response(rest, freq)))
    assert slow.inputs == tuple(Port(f"drive_v_{i}", "V") for i in range(3))
    assert slow.outputs == tuple(Port(f"mirror_m_{i}", "m") for i in range(3))
    assert [each.name for each in matrices.models(choice.source(several_axes.mission(), plate.scene.mirror))] == [
        *(MIRROR, MIRROR_AT_REST)
    ]


@pytest.mark.promise("export-34")
def test_sampled_plant_of_several_axes_is_what_their_controller_was_designed_for(plate):
    m, designed = of(plate, SAMPLED_PLANT), coupled_study.plants(plate.scene)[0]
    freq = grid(m.period_s)
    wanted = lti.frequency_response(designed.system, freq, designed.period_s)[:, :, :2]
    found = response(m, freq) @ decoupling(plate.scene.rest)
    largest = np.max(np.abs(wanted), axis=(1, 2), keepdims=True)
    known = 1e3 * 2.0**-lti.DESIGN_BITS  # to that both are rounded; a mode lasts 1e3 samples
    assert np.max(np.abs(found[:, :2] + wanted[:, :2]) / largest) < known
    assert np.max(np.abs(found[:, 2:] - wanted[:, 2:]) / largest) < known
    assert [p.name for p in m.inputs] == [f"command_v_{i}" for i in range(3)]
    assert [p.name for p in m.outputs] == [f"{n}_rad_{i}" for n in ("line_of_sight", "optical_error") for i in (0, 1)]
    assert m.system.order < designed.system.order
    assert "a mode that no output shows" in forms(m).zero_pole_gain  # the piston of the plate
    every = plate.scene.loop.optical.every
    assert (f"a sensor that delivers every {every} samples" in m.meaning) is (every > 1)


@pytest.mark.promise("export-34")
def test_loop_of_several_axes_is_controller_and_plant_and_keeps_its_margin(plate):
    loop, plant, controller = (of(plate, name) for name in (LOOP, SAMPLED_PLANT, CONTROLLER))
    freq = grid(loop.period_s)
    z = np.exp(2j * np.pi * freq * loop.period_s)
    theirs = [np.moveaxis(matrices.to_control(each)(z), 2, 0) for each in (loop, plant, controller)]
    wanted = -theirs[1][:, 2:] @ theirs[2]
    assert np.max(np.abs(theirs[0] - wanted)) < NINE_DIGITS * np.max(np.abs(wanted))
    least = np.min(np.linalg.svd(np.eye(2) + response(loop, grid(loop.period_s, 4000)), compute_uv=False))
    assert plate.design.margins.modulus * (1.0 - 1e-6) < least < 1.0
    assert np.max(np.abs(lti.feedback_poles(loop.system))) < 1.0
    assert (
        [p.name for p in loop.inputs]
        == [p.name for p in controller.inputs]
        == ["optical_error_rad_0", "optical_error_rad_1"]
    )


# ------------------------------------------------------------------------------------------------------------ structure
def test_copies_and_multiples_of_states_vanish_and_the_response_stays():
    delays = np.array([[0.5, 0, 0, 0, 0], [1, 0, 0, 0, 0], [0, 1, 0, 0, 0], [0, -2, 0, 0, 0], [0, 0, 0, 1, 0]])
    whole = model(delays, [[1], [0], [0], [0], [0]], [[0, 1, 3, 1, 0]], period_s=0.1)
    small = without_copies(whole.system)
    freq = grid(0.1)
    assert small.order == 3
    wanted = lti.frequency_response(whole.system, freq, 0.1)
    assert difference(lti.frequency_response(small, freq, 0.1), wanted) < 1e-12


def test_a_state_that_stays_zero_vanishes_and_a_minimal_system_stays():
    whole = model(np.diag([0.5, 0.0, 0.25]), [[1], [0], [1]], [[1, 1, 2]], period_s=0.1)
    assert without_copies(whole.system).order == 2
    minimal = model(np.diag([0.5, 0.25]), [[1], [1]], [[1, 2]], period_s=0.1)
    assert without_copies(minimal.system) is minimal.system


# ---------------------------------------------------------------------------------------------------------------- forms
def test_coefficients_are_exact():
    """(s + 3) / ((s + 1)(s + 2)(s + 0.5)) and its direct path, in a state space of powers of two."""
    made = model([[-3.5, -3.5, -1.0], [1, 0, 0], [0, 1, 0]], [[1], [0], [0]], [[0, 1, 3]], [[0.5]])
    tf = transfer_function(made)
    assert tf.denominator.tolist() == [1.0, 3.5, 3.5, 1.0]
    assert tf.numerator.tolist() == [0.5, 1.75, 2.75, 3.5]
    zpk = zero_pole_gain(made)
    assert sorted(zpk.poles.real) == [-2.0, -1.0, -0.5] and zpk.gain == 0.5
    assert np.max(np.abs(np.polyval([0.5, 1.75, 2.75, 3.5], zpk.zeros))) < 1e-14


def test_delays_have_their_poles_at_zero_to_the_last_bit():
    n = 8
    made = model(np.eye(n, k=-1), np.eye(n)[:, :1], np.eye(n)[-1:], period_s=1.0)
    zpk, tf = zero_pole_gain(made), transfer_function(made)
    assert zpk.poles.tolist() == [0.0] * n and zpk.zeros.size == 0 and zpk.gain == 1.0
    assert tf.numerator.tolist() == [1.0] and tf.denominator.tolist() == [1.0] + [0.0] * n
    assert (
        np.max(np.abs(np.linalg.eigvals(made.system.A + 1e-16 * np.eye(n, k=n - 1)))) > 1e-3
    )  # what rounding makes of it


def test_zeros_of_eq_2_are_those_of_its_numerator(file):
    part = of(file, LINEAR_PART)
    zpk = zero_pole_gain(part)
    linear = file.mission.mirror.linear
    assert np.sort(zpk.zeros.real) == pytest.approx(np.sort(np.roots(linear.numerator).real), rel=1e-10)
    wanted = np.roots(linear.denominator)
    assert np.sort_complex(zpk.poles) == pytest.approx(np.sort_complex(wanted), rel=1e-9)
    assert zpk.largest_error < ROUNDING


def test_eq_2_in_coefficients_costs_every_digit_of_a_state_space(file):
    tf = transfer_function(of(file, LINEAR_PART))
    assert tf.largest_error < ROUNDING  # the coefficients themselves are right
    assert 1e15 < tf.condition < 1e16
    assert tf.denominator == pytest.approx(file.mission.mirror.linear.denominator, rel=1e-10)


@pytest.mark.promise("export-33")
def test_error_of_the_coefficients_is_the_one_they_have(tracking):
    """The sampled loop in powers of z: slow poles near 1 cost digits, and how many is said."""
    m = of(tracking, LOOP)
    tf, zpk = transfer_function(m), zero_pole_gain(m)
    at = np.array([tf.at_hz])
    z = np.exp(2j * np.pi * at * m.period_s)
    own = abs(np.polyval(tf.numerator, z) / np.polyval(tf.denominator, z) / response(m, at)[:, 0, 0] - 1.0)[0]
    assert tf.largest_error == pytest.approx(own, rel=1e-6)
    assert tf.largest_error > 1e-3 and tf.at_hz < 10.0
    assert zpk.largest_error < NINE_DIGITS


def test_entries_of_several_inputs_and_outputs_are_given_one_by_one(tracking):
    m = of(tracking, CONTROLLER)
    found = forms(m)
    freq = grid(m.period_s)
    z, wanted = np.exp(2j * np.pi * freq * m.period_s), response(m, freq)
    for o, i in np.ndindex(wanted.shape[1:]):
        tf, zpk = found.transfer_function[o][i], found.zero_pole_gain[o][i]
        by_powers = np.polyval(tf.numerator, z) / np.polyval(tf.denominator, z)
        by_roots = zpk.gain * np.prod(z[:, None] - zpk.zeros, axis=1) / np.prod(z[:, None] - zpk.poles, axis=1)
        assert np.allclose(by_powers, wanted[:, o, i], rtol=1e-10, atol=0.0)
        assert np.allclose(by_roots, wanted[:, o, i], rtol=1e-10, atol=0.0)
    assert found.transfer_function[1][0].numerator.tolist() == [0.0]  # the target is the reference alone
    assert found.transfer_function[0][0].numerator[0] < 0.0 < found.transfer_function[0][1].numerator[0]


@pytest.mark.parametrize(
    ("made", "why"),
    [
        (model(np.diag([-1.0, -20.0]), [[1], [0]], [[1, 1]]), r"no input drives: 3\.183 Hz with a damping ratio of 1"),
        (model(np.diag([-1.0, -20.0]), [[1], [1]], [[0, 1]]), r"no output shows: 0\.1592 Hz"),
        (model(np.diag([0.5, -1.0]), [[1], [1]], [[1, 0]], period_s=0.01), r"no output shows: \|z\| = 1 at 50 Hz"),
    ],
)
def test_hidden_modes_are_refused_by_name(made, why):
    found = forms(made)
    assert re.match(f"made: not minimal, it has a mode that {why}.*minimal realisation", found.zero_pole_gain)
    assert found.transfer_function == found.zero_pole_gain
    assert response(made, np.array([1.0])).shape == (1, 1, 1)


def test_a_mode_that_one_entry_lacks_is_no_hidden_one():
    made = model(np.diag([-1.0, -2.0]), np.eye(2), np.eye(2))
    found = forms(made)
    assert [[e.poles.tolist() for e in row] for row in found.zero_pole_gain] == [[[-1.0], []], [[], [-2.0]]]


@pytest.mark.parametrize(
    ("made", "where"),
    [
        (model([[0.25]], [[1]], [[1]]), r"0\.03979 Hz with a damping ratio of -1"),
        (model([[1.01]], [[1]], [[1]], period_s=0.01), r"\|z\| = 1\.01 at 0 Hz"),
    ],
)
def test_unstable_models_are_refused_as_coefficients_alone(made, where):
    found = forms(made)
    assert re.match(f"made: unstable, {where}.*state space or zeros and poles", found.transfer_function)
    assert found.zero_pole_gain[0][0].poles.size == 1
    integrator = model([[1.0]], [[1]], [[1]], period_s=0.01)
    assert transfer_function(integrator).denominator.tolist() == [1.0, -1.0]


def test_orders_beyond_floats_are_refused():
    with pytest.raises(ExportError, match=r"101 states .* takes 100"):
        polynomials(model(np.diag(-np.arange(1.0, 102.0)), np.ones((101, 1)), np.ones((1, 101))).system)


def test_as_many_states_as_are_taken_are_taken(monkeypatch):
    monkeypatch.setattr(matrix_forms, "MOST_STATES", 3)
    made = [model(np.diag(-np.arange(1.0, n + 1.0)), np.ones((n, 1)), np.ones((1, n))).system for n in (3, 4)]
    assert [float(each) for each in polynomials(made[0])[1]] == [1.0, 6.0, 11.0, 6.0]
    with pytest.raises(ExportError, match=r"4 states .* takes 3"):
        polynomials(made[1])


@pytest.mark.parametrize(
    ("pole", "period_s", "unstable"),
    [
        (1.0, 0.01, False),
        (-1.0, 0.01, False),
        (1.0 + 0.9e-9, 0.01, False),  # but for rounding
        (1.0 + 1.1e-9, 0.01, True),
        (-1.0 - 1.1e-9, 0.01, True),
        (0.0, 0.0, False),
        (-5.0, 0.0, False),
        (1e-12, 0.0, True),
        (5.0, 0.0, True),
    ],
)
def test_integrators_are_stable_and_what_lies_beyond_them_is_not(pole, period_s, unstable):
    system = lti.StateSpace(np.diag([-0.5, pole]), np.ones((2, 1)), np.ones((1, 2)), np.zeros((1, 1)))
    if not unstable:
        structure.refuse_unstable(system, period_s, "made")
        return
    with pytest.raises(ExportError, match=r"^made: unstable, ") as refused:
        structure.refuse_unstable(system, period_s, "made")
    assert structure.pole_text(pole, period_s) in str(refused.value)  # the pole that is meant


def test_an_undamped_pair_is_stable_and_one_that_grows_is_not():
    for decay, unstable in ((0.0, False), (-1.0, False), (1e-6, True)):
        A = np.array([[decay, 100.0], [-100.0, decay]])
        system = lti.StateSpace(A, np.ones((2, 1)), np.ones((1, 2)), np.zeros((1, 1)))
        if unstable:
            with pytest.raises(ExportError, match=r"unstable, 15\.92 Hz with a damping ratio of -1e-08"):
                structure.refuse_unstable(system, 0.0, "made")
        else:
            structure.refuse_unstable(system, 0.0, "made")


@pytest.mark.parametrize(
    ("pole", "period_s", "text"),
    [
        (-10.0, 0.0, "1.592 Hz with a damping ratio of 1"),
        (10.0, 0.0, "1.592 Hz with a damping ratio of -1"),
        (complex(-3.0, 4.0), 0.0, "0.7958 Hz with a damping ratio of 0.6"),
        (0.0, 0.0, "0 Hz with a damping ratio of 1"),
        (0.5, 0.01, "|z| = 0.5 at 0 Hz"),
        (-0.5, 0.01, "|z| = 0.5 at 50 Hz"),
        (complex(0.0, -0.25), 0.01, "|z| = 0.25 at 25 Hz"),
    ],
)
def test_a_root_in_words(pole, period_s, text):
    assert structure.pole_text(pole, period_s) == text


@pytest.mark.parametrize("key", ["A", "B", "C", "D"])
@pytest.mark.parametrize(("number", "refused"), [(1e100, False), (1.01e100, True), (np.inf, True), (np.nan, True)])
def test_each_matrix_has_numbers_that_floats_can_multiply(monkeypatch, key, number, refused):
    system = model(np.diag([-1.0, -2.0]), [[1], [1]], [[1, 1]]).system
    changed = replace(system, **{key: getattr(system, key) + np.full(getattr(system, key).shape, number)})
    monkeypatch.setattr(structure, "_balanced", lambda given: (np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0))))
    if refused:
        with pytest.raises(ExportError, match=r"made: it holds a number that is not finite or beyond 1e\+100"):
            structure.refuse_hidden(changed, 0.0, "made")
    else:
        structure.refuse_hidden(changed, 0.0, "made")


# ----------------------------------------------------------------------------------------------------------------- .mat
@pytest.fixture(scope="module")
def written(file, tracking, pointing, gauged, tmp_path_factory):
    """The models of the mission and of three controllers under names of their own, and their file."""
    found = list(matrices.models(choice.source(file)))
    for name, chosen in (("tracking", tracking), ("pointing", pointing), ("gauged", gauged)):
        several = models(chosen)[2:]
        found += [replace(m, name=f"{name}_{m.name}") for m in several]
    path = tmp_path_factory.mktemp("mat") / "models.mat"
    matrices.write_mat(found, path)
    return found, path


def same(model, fields):
    """The fields of a file hold the model to the last bit."""
    windup = np.zeros((0, 0)) if model.anti_windup is None else model.anti_windup
    for key, wanted in {**{key: getattr(model.system, key) for key in "ABCD"}, "L": windup}.items():
        found = np.asarray(fields[key], dtype=float, order="C")
        assert found.shape == wanted.shape and found.tobytes() == wanted.tobytes()
    assert fields["Ts"].item() == model.period_s
    origin = model.origin
    texts = [fields[key] for key in ("meaning", "Mission", "MissionSha256", "Mirror")]
    assert texts == [model.meaning, origin.mission, origin.mission_sha256, origin.mirror]
    for kind, ports in (("Input", model.inputs), ("Output", model.outputs), ("State", model.states)):
        assert [str(each) for each in fields[f"{kind}Name"].reshape(-1)] == [p.name for p in ports]
        assert [str(each) for each in fields[f"{kind}Unit"].reshape(-1)] == [p.unit for p in ports]


def test_mat_reads_back_to_the_last_bit(written):
    found, path = written
    back = load(path)
    assert list(back) == [m.name for m in found] and len(found) == 11
    for m in found:
        same(m, back[m.name].fields)


@pytest.mark.promise("export-1", "export-33")
def test_scipy_reads_the_same_numbers(written):
    found, path = written
    variables = loadmat(path, struct_as_record=True)
    for m in found:
        record = variables[m.name][0, 0]
        for key in "ABCD":
            assert np.asarray(record[key], dtype=float, order="C").tobytes() == getattr(m.system, key).tobytes()
        assert record["Ts"].item() == m.period_s
        assert [name.item() for name in record["InputName"][:, 0]] == [p.name for p in m.inputs]
        assert [unit.item() for unit in record["OutputUnit"][:, 0]] == [p.unit for p in m.outputs]
        said = [record[key].item() for key in ("Mission", "MissionSha256", "Mirror")]
        assert all(said) and said == [m.origin.mission, m.origin.mission_sha256, m.origin.mirror]


@pytest.mark.promise("export-33")
def test_scipy_reads_zeros_poles_and_coefficients(written):
    found, path = written
    variables = loadmat(path)
    single, several = found[0], found[3]
    record, zpk = variables[single.name][0, 0], zero_pole_gain(single)
    assert np.array_equal(record["z"][:, 0], zpk.zeros) and np.array_equal(record["p"][:, 0], zpk.poles)
    assert record["k"].item() == zpk.gain and record["zpkError"].item() == zpk.largest_error
    tf = transfer_function(single)
    assert np.array_equal(record["num"][0], tf.numerator) and np.array_equal(record["den"][0], tf.denominator)
    assert record["tfCondition"].item() == tf.condition and record["tfRefused"].size == 0
    record = variables[several.name][0, 0]
    assert record["num"].shape == (2, 2) == record["k"].shape
    assert np.array_equal(record["num"][0, 1][0], transfer_function(several, 0, 1).numerator)


@pytest.mark.promise("export-33")
def test_a_form_that_is_refused_is_missing_with_its_reason(tmp_path):
    matrices.write_mat([model(np.diag([-1.0, -2.0]), [[1], [0]], [[1, 1]])], tmp_path / "a.mat")
    record = loadmat(tmp_path / "a.mat")["made"][0, 0]
    assert "z" not in record.dtype.names and "num" not in record.dtype.names
    assert "not minimal" in record["zpkRefused"].item() and "not minimal" in record["tfRefused"].item()


def test_each_form_has_the_reason_of_its_own():
    fields = matrices_files._form_fields(SimpleNamespace(zero_pole_gain="of roots", transfer_function="of powers"))
    assert fields == {"zpkRefused": "of roots", "tfRefused": "of powers"}


@pytest.mark.promise("export-33")
def test_mat_is_the_same_from_day_to_day(written, tmp_path):
    found, path = written
    matrices.write_mat(found, tmp_path / "again.mat")
    assert (tmp_path / "again.mat").read_bytes() == path.read_bytes()
    assert path.read_bytes()[:40] == b"MATLAB 5.0 MAT-file, microrad linear mod"
    assert not list(tmp_path.glob(".*"))


@pytest.mark.parametrize("name", ["2nd", "a b", "end", "x" * 32, "_x", ""])
def test_names_that_matlab_does_not_take_are_refused(name, tmp_path):
    with pytest.raises(ExportError, match="is no name of a variable in MATLAB"):
        matrices.write_mat([model([[-1]], [[1]], [[1]], name=name)], tmp_path / "a.mat")
    assert not list(tmp_path.iterdir())


def test_two_models_of_a_name_are_refused(tmp_path):
    with pytest.raises(ExportError, match="two models are called 'made'"):
        matrices.write_mat([model([[-1]], [[1]], [[1]])] * 2, tmp_path / "a.mat")
    assert not list(tmp_path.iterdir())


def test_a_file_that_cannot_be_written_is_said(tmp_path):
    with pytest.raises(ExportError, match=r"could not be written .*so nothing is"):
        matrices.write_mat([model([[-1]], [[1]], [[1]])], tmp_path / "none" / "a.mat")


def element(kind, data):
    return struct.pack("<II", kind, len(data)) + data + b"\0" * (-len(data) % 8)


def nested(depth):
    """A cell in a cell in a cell."""
    data = b""
    for _ in range(depth):
        parts = ((6, struct.pack("<II", 1, 0)), (5, struct.pack("<ii", 1, 1)), (1, b"x" * 8))
        data = b"".join(element(*part) for part in parts) + element(14, data)
    return element(14, data)


HEAD = b"MATLAB 5.0 MAT-file".ljust(124) + b"\x00\x01IM"


@pytest.mark.parametrize(
    ("data", "why"),
    [
        (b"", "no header of version 5"),
        (b"\x80\x04\x95pickle".ljust(200), "no header of version 5"),
        (b"MATLAB 7.3 MAT-file".ljust(600), "version 7.3; save it as version 7"),
        (b"\x89HDF\r\n\x1a\n".ljust(600), "version 7.3"),
        (HEAD + struct.pack("<II", 14, 4000) + b"short", "an element is cut off"),
        (HEAD + nested(5_000), "nest deeper than 16"),
        (HEAD + struct.pack("<II", 15, 5) + b"wrong", "incorrect header check"),
        (HEAD + element(14, b"\xff" * 64), "no MATLAB file that can be read"),
        (HEAD + element(14, struct.pack("<IIII", 6, 8, 6, 0)), "no MATLAB file that can be read"),
    ],
)
def test_hostile_files_are_refused_before_or_by_the_reader(data, why, tmp_path):
    path = tmp_path / "bad.mat"
    path.write_bytes(data)
    with pytest.raises(ExportError, match=why) as error:
        load(path)
    assert "bad.mat" in str(error.value)


def test_a_file_that_unpacks_to_too_much_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr("microrad.export.linear_import.matlab.MOST_BYTES", 100_000)
    path = tmp_path / "bomb.mat"
    parts = ((6, struct.pack("<II", 6, 0)), (5, struct.pack("<ii", 125_000, 1)), (1, b"A" * 8), (9, bytes(1_000_000)))
    packed = zlib.compress(element(14, b"".join(element(*part) for part in parts)))
    path.write_bytes(HEAD + struct.pack("<II", 15, len(packed)) + packed)
    with pytest.raises(ExportError, match="unpacks to more than 100000 bytes"):
        load(path)
    path.write_bytes(HEAD.ljust(100_001))
    with pytest.raises(ExportError, match="has 100001 bytes; a linear model has at most 100000"):
        load(path)


def test_missing_files_are_refused(tmp_path):
    with pytest.raises(ExportError, match=r"none\.mat cannot be read"):
        load(tmp_path / "none.mat")


@pytest.mark.parametrize("how", [{"do_compression": True}, {"long_field_names": True}])
def test_other_ways_to_save_are_read(how, written, tmp_path):
    variables = {name: value for name, value in loadmat(written[1]).items() if not name.startswith("__")}
    savemat(tmp_path / "other.mat", variables, **how)
    back = load(tmp_path / "other.mat")
    for m in written[0]:
        same(m, back[m.name].fields)


def test_random_damage_is_refused_or_read_and_nothing_else(file, tmp_path):
    """The library's own reader ends the process on some of these."""
    path, seen = tmp_path / "a.mat", set()
    matrices.write_mat([of(file, MIRROR)], path)
    whole, rng = path.read_bytes(), np.random.default_rng(1)
    for _ in range(300):
        data = bytearray(whole)
        for place in rng.integers(128, len(data), rng.integers(1, 4)):
            data[place] = rng.integers(256)
        path.write_bytes(data[: rng.integers(128, len(data))] if rng.random() < 0.2 else data)
        try:
            seen.add(type(load(path)))
        except ExportError:
            seen.add(ExportError)
    assert seen == {dict, ExportError}


# ----------------------------------------------------------------------------------------------------------------- JSON
@pytest.mark.promise("export-33")
def test_json_reads_back_to_the_last_bit(written):
    found, _ = written
    data = json.loads(matrices.json_text(found))
    assert data["format"] == "microrad linear models" and data["version"] == 1
    for m, each in zip(found, data["models"], strict=True):
        for key in "ABCD":
            assert (
                np.array(each[key], dtype=float).reshape(getattr(m.system, key).shape).tobytes()
                == getattr(m.system, key).tobytes()
            )
        assert each["Ts_s"] == m.period_s
        said = [each[key] for key in ("mission", "mission_sha256", "mirror")]
        assert said == [m.origin.mission, m.origin.mission_sha256, m.origin.mirror]
        assert each["inputs"] == [{"name": p.name, "unit": p.unit} for p in m.inputs]
    zpk = zero_pole_gain(found[0])
    entry = data["models"][0]["zero_pole_gain"]["entries"][0][0]
    assert [complex(*pair) for pair in entry["poles"]] == zpk.poles.tolist()
    assert entry["gain"] == zpk.gain


def test_json_says_what_is_refused_and_takes_no_nan():
    hidden = json.loads(matrices.json_text([model(np.diag([-1.0, -2.0]), [[1], [0]], [[1, 1]])]))["models"][0]
    assert "not minimal" in hidden["zero_pole_gain"]["refused"]
    assert hidden["mission"] is None and hidden["anti_windup"] is None
    with pytest.raises(ExportError, match="made holds a number that is not finite"):
        matrices.json_text([model([[-1.0]], [[1.0]], [[1.0]], [[np.nan]])])


# ------------------------------------------------------------------------------------------------------- python-control
def test_python_control_has_the_same_matrices_and_names(pointing):
    for m in models(pointing):
        theirs = matrices.to_control(m)
        assert isinstance(theirs, python_control.StateSpace)
        assert theirs.dt == m.period_s and theirs.name == m.name
        assert theirs.input_labels == [p.name for p in m.inputs] and theirs.state_labels == [p.name for p in m.states]
        assert all(np.array_equal(getattr(theirs, key), getattr(m.system, key)) for key in "ABCD")


@pytest.mark.promise("export-35")
def test_without_python_control_the_extra_is_named(file, monkeypatch):
    monkeypatch.setitem(sys.modules, "control", None)
    with pytest.raises(ExportError, match=r"not installed.*constraints.txt '\.\[control\]'"):
        matrices.to_control(of(file, MIRROR))


def test_model_of_the_mirror_is_the_mirrors_own_loop(file):
    m = file.mission.mirror
    made = mirror.from_mission(m, mirror.hysteresis_model(m, m.rate_limit_v_s, m.bias_v)).linear_loop
    assert np.array_equal(of(file, MIRROR).system.A, made.A)


def test_a_plant_of_one_axis_says_that_its_sensor_is_slow_and_has_a_gauge_only_where_there_is_one(pointing):
    """Nothing else of the model hangs on either."""
    scene = pointing.scene
    for every in (1, 2):
        for gauge in (scene.axis.gauge, None):
            loop = replace(scene.loop, optical=replace(scene.loop.optical, every=every))
            other = SimpleNamespace(axis=replace(scene.axis, gauge=gauge), loop=loop, table=scene.table)
            plant, _ = _pointing_models(replace(pointing, scene=other))
            names = ["line_of_sight_rad", "optical_error_rad", "gauge_rad"]
            assert [port.name for port in plant.outputs] == names[: 2 + (gauge is not None)]
            slow = "; a sensor that delivers every 2 samples counts as one of more delay"
            assert plant.meaning.endswith(slow) is (every == 2)
            assert ("every" in plant.meaning) is (every == 2)
            np.testing.assert_array_equal(plant.system.C[:2], of(pointing, SAMPLED_PLANT).system.C[:2])
            np.testing.assert_array_equal(plant.system.A, of(pointing, SAMPLED_PLANT).system.A)


@pytest.mark.parametrize(("bias_v", "said"), [(37.5, "37.5 V"), (0.25, "0.25 V"), (50.0, "50 V")])
def test_models_of_several_axes_say_the_bias_that_they_count_from_as_it_is(bias_v, said):
    plain = several_axes.three_actuators()
    rests = replace(plain, actuators=tuple(replace(each, bias_v=bias_v) for each in plain.actuators))
    found = matrices.models(choice.source(several_axes.mission(), rests))
    assert [each.meaning.rpartition(" count from rest at ")[2] for each in found] == [said] * 2


# ------------------------------------------------------------------------------- two inputs and two outputs as a whole
def two_by_two(period_s=0.0, **changes):
    """Three states of which each way has its own; every number unlike the others."""
    A = np.diag([-2.0, -5.0, -11.0]) if not period_s else np.diag([0.5, -0.25, 0.75])
    B = np.array([[1.0, 0.0], [2.0, 3.0], [0.0, 7.0]])
    C = np.array([[4.0, 0.0, 0.5], [1.5, -2.5, 0.0]])
    D = np.array([[0.0, 0.125], [0.0, 0.0]])
    given = LinearModel(
        "two",
        "what it is",
        lti.StateSpace(A, B, C, D),
        period_s,
        (Port("a", "V"), Port("b", "V")),
        (Port("x", "rad"), Port("y", "m")),
        (Port("s0", "1"), Port("s1", ""), Port("s2", "rad/s")),
        Origin("a mission", "f" * 64, "a mirror"),
        np.array([[0.5, 1.5], [2.5, 3.5], [4.5, 5.5]]),
    )
    return replace(given, **changes)


def without_numerics(entry):
    """An entry without what only rounding decides: the error of its response, and where that is largest."""
    return {key: value for key, value in entry.items() if key not in ("largest_error", "at_hz")}


@pytest.mark.parametrize("period_s", [0.0, 0.01])
def test_each_entry_of_two_by_two_has_the_roots_and_powers_of_its_own_way(period_s):
    found = forms(two_by_two(period_s))
    for form in (found.zero_pole_gain, found.transfer_function):
        freq = np.array([0.03, 0.7, 30.0])
        s = np.exp(2j * np.pi * freq * period_s) if period_s else 2j * np.pi * freq
        exact = lti.frequency_response(two_by_two(period_s).system, freq, period_s or None)
        for o, row in enumerate(form):
            for i, entry in enumerate(row):
                if hasattr(entry, "zeros"):
                    value = matrix_forms.factored(entry.zeros, entry.poles, entry.gain, s)
                else:
                    value = np.polyval(entry.numerator, s) / np.polyval(entry.denominator, s)
                np.testing.assert_allclose(value, exact[:, o, i], rtol=1e-9)
    orders = [[len(entry.poles) for entry in row] for row in found.zero_pole_gain]
    assert orders == [[1, 1], [2, 1]]


def test_json_of_two_by_two_has_every_field_of_the_model():
    (found,) = json.loads(matrices.json_text([two_by_two()]))["models"]
    for form in ("zero_pole_gain", "transfer_function"):
        found[form] = [[without_numerics(entry) for entry in row] for row in found[form]["entries"]]
    assert rounded(found) == {
        "name": "two",
        "meaning": "what it is",
        "mission": "a mission",
        "mission_sha256": "ffffffffffffffffffffffffffffffffffffffffffffffffffffffffffffffff",
        "mirror": "a mirror",
        "Ts_s": 0.0,
        "inputs": [{"name": "a", "unit": "V"}, {"name": "b", "unit": "V"}],
        "outputs": [{"name": "x", "unit": "rad"}, {"name": "y", "unit": "m"}],
        "states": [{"name": "s0", "unit": "1"}, {"name": "s1", "unit": ""}, {"name": "s2", "unit": "rad/s"}],
        "A": [[-2.0, 0.0, 0.0], [0.0, -5.0, 0.0], [0.0, 0.0, -11.0]],
        "B": [[1.0, 0.0], [2.0, 3.0], [0.0, 7.0]],
        "C": [[4.0, 0.0, 0.5], [1.5, -2.5, 0.0]],
        "D": [[0.0, 0.125], [0.0, 0.0]],
        "anti_windup": [[0.5, 1.5], [2.5, 3.5], [4.5, 5.5]],
        "zero_pole_gain": [
            [
                {"zeros": [], "poles": [[-2.0, 0.0]], "gain": 4.0},
                {"zeros": [[-39.0, 0.0]], "poles": [[-11.0, 0.0]], "gain": 0.125},
            ],
            [
                {"zeros": [[-0.714286, 0.0]], "poles": [[-5.0, 0.0], [-2.0, 0.0]], "gain": -3.5},
                {"zeros": [], "poles": [[-5.0, 0.0]], "gain": -7.5},
            ],
        ],
        "transfer_function": [
            [
                {"numerator": [4.0], "denominator": [1.0, 2.0], "condition": 1.0},
                {"numerator": [0.125, 4.875], "denominator": [1.0, 11.0], "condition": 1.0},
            ],
            [
                {"numerator": [-3.5, -2.5], "denominator": [1.0, 7.0, 10.0], "condition": 14.933},
                {"numerator": [-7.5], "denominator": [1.0, 5.0], "condition": 1.0},
            ],
        ],
    }


def test_mat_of_two_by_two_has_each_field_in_its_own_shape(tmp_path):
    matrices.write_mat([two_by_two(0.01), two_by_two(name="other", anti_windup=None, origin=None)], tmp_path / "m.mat")
    found = loadmat(tmp_path / "m.mat", simplify_cells=True)
    two, other = found["two"], found["other"]
    assert sorted(two) == [
        "A",
        "B",
        "C",
        "D",
        "InputName",
        "InputUnit",
        "L",
        "Mirror",
        "Mission",
        "MissionSha256",
        "OutputName",
        "OutputUnit",
        "StateName",
        "StateUnit",
        "Ts",
        "den",
        "k",
        "meaning",
        "num",
        "p",
        "tfCondition",
        "tfError",
        "tfErrorHz",
        "tfRefused",
        "z",
        "zpkError",
        "zpkErrorHz",
        "zpkRefused",
    ]
    kept = {
        key: two[key] for key in ("A", "B", "C", "D", "L", "Ts", "k", "meaning", "Mission", "MissionSha256", "Mirror")
    }
    kept |= {key: two[key].tolist() for key in ("InputName", "InputUnit", "OutputName", "OutputUnit", "StateName")}
    assert rounded(kept) == {
        "A": [[0.5, 0.0, 0.0], [0.0, -0.25, 0.0], [0.0, 0.0, 0.75]],
        "B": [[1.0, 0.0], [2.0, 3.0], [0.0, 7.0]],
        "C": [[4.0, 0.0, 0.5], [1.5, -2.5, 0.0]],
        "D": [[0.0, 0.125], [0.0, 0.0]],
        "L": [[0.5, 1.5], [2.5, 3.5], [4.5, 5.5]],
        "Ts": 0.01,
        "k": [[4.0, 0.125], [-3.5, -7.5]],
        "meaning": "what it is",
        "Mission": "a mission",
        "MissionSha256": "ffffffffffffffffffffffffffffffffffffffffffffffffffffffffffffffff",
        "Mirror": "a mirror",
        "InputName": ["a", "b"],
        "InputUnit": ["V", "V"],
        "OutputName": ["x", "y"],
        "OutputUnit": ["rad", "m"],
        "StateName": ["s0", "s1", "s2"],
    }
    assert [np.atleast_1d(two["p"][0][i]).tolist() for i in range(2)] == [[0.5], [0.75]]
    assert (other["Ts"], other["Mission"].size, other["L"].size) == (0, 0, 0)
    assert np.atleast_1d(other["num"][0][1]).tolist() == pytest.approx([0.125, 4.875])
    assert np.atleast_1d(other["den"][0][1]).tolist() == [1.0, 11.0]
    assert two["StateUnit"].tolist()[::2] == ["1", "rad/s"] and two["zpkRefused"].size == two["tfRefused"].size == 0


def test_an_unstable_model_has_its_roots_and_the_reason_why_it_has_no_powers(tmp_path):
    system = lti.StateSpace(np.diag([-2.0, 3.0]), np.ones((2, 1)), np.array([[1.0, 2.0]]), np.zeros((1, 1)))
    ports = {"inputs": (Port("a", "V"),), "outputs": (Port("x", "rad"),), "states": (Port("s", "1"), Port("t", "1"))}
    of = two_by_two(system=system, anti_windup=None, **ports)
    found = forms(of)
    assert found.transfer_function == (
        "two: unstable, 0.4775 Hz with a damping ratio of -1. Coefficients would hide it; "
        "take the state space or zeros and poles, or export a stable model"
    )
    ((entry,),) = found.zero_pole_gain
    assert sorted(entry.poles.real) == pytest.approx([-2.0, 3.0]) and entry.gain == 3.0
    hidden = replace(of, system=replace(system, C=np.array([[1.0, 0.0]])))
    assert forms(hidden).zero_pole_gain == forms(hidden).transfer_function
    assert forms(hidden).zero_pole_gain == (
        "two: not minimal, it has a mode that no output shows: 0.4775 Hz with a damping "
        "ratio of -1. Zeros, poles and coefficients would hide it; take the state space, "
        "or a minimal realisation of it (minreal)"
    )


@pytest.mark.parametrize(
    ("raised", "said"),
    [
        (PermissionError(13, "Permission denied"), "could not be written (Permission denied), so nothing is"),
        (OSError("no more room"), "could not be written (no more room), so nothing is"),
    ],
)
def test_a_disk_that_takes_no_models_is_told_with_its_reason(raised, said, tmp_path, monkeypatch):
    def broken(*args):
        raise raised

    monkeypatch.setattr(matrices_files, "write_whole", broken)
    with pytest.raises(ExportError, match=re.escape(f"{tmp_path / 'm.mat'} {said}")):
        matrices.write_mat([two_by_two()], tmp_path / "m.mat")


@pytest.mark.parametrize("name", ["x" * 31, "a_1", "endx", "iff"])
def test_names_that_begin_as_a_keyword_or_are_as_long_as_may_be_are_taken(name, tmp_path):
    matrices.write_mat([two_by_two(name=name)], tmp_path / "m.mat")
    assert name in loadmat(tmp_path / "m.mat")


def test_a_state_that_is_a_combination_of_others_leaves_the_same_map():
    """x2 = 2 x0 - x1 in each sample: its column is spread over those of the others."""
    A = np.array([[0.5, 0.0, 0.25], [0.1, 0.3, 0.0], [0.9, -0.3, 0.5]])
    B, C = np.array([[1.0], [4.0], [-2.0]]), np.array([[1.0, 2.0, 3.0], [0.0, 1.0, -1.0]])
    made = structure.without_state(lti.StateSpace(A, B, C, np.zeros((2, 1))), 2, np.array([[2.0, -1.0, 0.0]]))
    assert made.A.tolist() == [[1.0, -0.25], [0.1, 0.3]]
    assert (made.B.tolist(), made.C.tolist()) == ([[1.0], [4.0]], [[7.0, -1.0], [-2.0, 2.0]])


def test_copies_with_a_factor_are_read_through_the_first_of_them():
    """x1 = 2 x0 and x3 = -x2 / 4 behind a sample; nothing reads x4."""
    A, B = np.zeros((5, 5)), np.array([[1.0, 0.0], [2.0, 0.0], [0.0, 4.0], [0.0, -1.0], [1.0, 1.0]])
    C = np.array([[1.0, 10.0, 0.0, 0.0, 0.0], [0.0, 0.0, 3.0, 8.0, 0.0]])
    made = without_copies(lti.StateSpace(A, B, C, np.zeros((2, 2))))
    assert (made.B.tolist(), made.C.tolist()) == ([[1.0, 0.0], [0.0, 4.0]], [[21.0, 0.0], [0.0, 1.0]])


def test_roots_of_a_polynomial_with_some_at_zero_and_far_apart():
    coefficients = [Fraction(2)]
    for root in (Fraction(-1, 1024), Fraction(3), Fraction(-4096)):
        coefficients = [a - root * b for a, b in zip([*coefficients, 0], [0, *coefficients], strict=True)]
    found = matrix_forms.roots([*coefficients, Fraction(0), Fraction(0)])
    assert sorted(found.real.tolist()) == [-4096.0, -1.0 / 1024.0, 0.0, 0.0, 3.0] and not found.imag.any()


@pytest.mark.parametrize("period_s", [0.0, 1e-3])
def test_a_gain_without_states_is_stable_and_minimal(period_s):
    gain = lti.StateSpace(np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), np.array([[2.5]]))
    structure.refuse_unstable(gain, period_s, "gain")
    structure.refuse_hidden(gain, period_s, "gain")
    assert structure.without_copies(gain) is gain
    entry = structure.entry_of(gain, 0, 0)
    assert (entry.order, entry.D.tolist()) == (0, [[2.5]])
    port = (Port("a", "V"),)
    found = forms(LinearModel("gain", "", gain, period_s, port, port, (), None))
    ((by_roots,),), ((by_powers,),) = found.zero_pole_gain, found.transfer_function
    assert (by_roots.zeros.size, by_roots.poles.size, by_roots.gain, by_roots.largest_error) == (0, 0, 2.5, 0.0)
    assert (by_powers.numerator.tolist(), by_powers.denominator.tolist(), by_powers.condition) == ([2.5], [1.0], 1.0)


@pytest.mark.parametrize("denominator", [[1.0, 5.0], [1.0, 0.0], [1.0, 3.0, 2.0], [1.0, -0.25, 4.0, 0.0]])
def test_a_transfer_function_has_the_condition_of_its_companion_matrix(denominator):
    n = len(denominator) - 1
    A = np.eye(n, k=-1)
    A[0] = -np.array(denominator[1:])
    entry = lti.StateSpace(A, np.eye(n)[:, :1], np.eye(n)[-1:], np.zeros((1, 1)))
    found = matrix_forms._transfer_function(entry, *polynomials(entry), 1e-3)
    assert found.denominator.tolist() == denominator and found.numerator.tolist() == [1.0]
    slow = np.trim_zeros(denominator, "b")
    companion = np.eye(len(slow) - 1, k=-1)
    companion[:1] = -np.array(slow[1:])
    own = np.linalg.cond(companion) if len(slow) > 1 else 1.0
    assert found.condition == pytest.approx(own, rel=1e-9) and found.largest_error < 1e-9


def test_roots_keep_their_digits_through_scales_of_many_decades():
    for scale in (Fraction(1), Fraction(10**40), Fraction(1, 10**40)):
        coefficients = [Fraction(3), -Fraction(9) * scale, Fraction(6) * scale**2, Fraction(0)]
        found = np.sort(matrix_forms.roots(coefficients).real)
        np.testing.assert_allclose(found, [0.0, float(scale), 2.0 * float(scale)], rtol=1e-15)
    pair = matrix_forms.roots([Fraction(2), Fraction(-4), Fraction(10)])
    assert sorted(pair.tolist(), key=lambda r: r.imag) == [complex(1.0, -2.0), complex(1.0, 2.0)]
    assert matrix_forms.roots([Fraction(7)]).size == 0 and matrix_forms.roots([Fraction(7), Fraction(0)]).tolist() == [
        0j
    ]


def test_a_coefficient_that_no_float_holds_is_refused():
    assert matrix_forms.floats([Fraction(1, 3), Fraction(10**308)]).tolist() == [1 / 3, 1e308]
    with pytest.raises(ExportError, match="beyond the range of a float; take a slower unit of time, or fewer states"):
        matrix_forms.floats([Fraction(1), Fraction(10**309)])


# ----------------------------------------------------------------------------------------------- several models at once
def test_a_number_that_json_has_not_is_told_with_the_names_of_all_models():
    given = [two_by_two(name=name) for name in ("one", "two", "three")]
    system = replace(given[1].system, D=np.array([[0.0, np.inf], [0.0, 0.0]]))
    given[1] = replace(given[1], system=system)
    with pytest.raises(ExportError) as told:
        matrices.json_text(given)
    said = str(told.value)
    assert said.startswith("one of the models one, two, three holds a number that is not finite (")
    assert said.endswith("); JSON has none, write a .mat file")


@pytest.mark.parametrize(
    ("names", "said"),
    [
        (
            ("a", "end", "b"),
            "'end' is no name of a variable in MATLAB: a letter, then at most 30 letters, digits or _, and no ",
        ),
        (("a", "b", "2c"), "'2c' is no name of a variable in MATLAB: "),
        (("a", "b", "c", "b"), "two models are called 'b'; rename one of them"),
    ],
)
def test_a_wrong_name_behind_right_ones_is_the_one_that_is_told(names, said, tmp_path):
    with pytest.raises(ExportError) as told:
        matrices.write_mat([two_by_two(name=name) for name in names], tmp_path / "m.mat")
    assert str(told.value).startswith(said) and not list(tmp_path.iterdir())


@pytest.mark.parametrize("period_s", [0.0, 0.01])
def test_an_object_of_python_control_has_the_names_of_two_inputs_two_outputs_and_three_states(period_s):
    theirs = matrices.to_control(two_by_two(period_s))
    assert (theirs.name, theirs.dt, theirs.input_labels, theirs.output_labels) == (
        "two",
        period_s,
        ["a", "b"],
        ["x", "y"],
    )
    assert theirs.state_labels == ["s0", "s1", "s2"]
    unread = two_by_two(
        system=lti.StateSpace(np.diag([-1.0, -2.0, -3.0]), np.zeros((3, 2)), np.zeros((2, 3)), np.eye(2))
    )
    assert matrices.to_control(unread).nstates == 3


@pytest.mark.parametrize("every", [1, 2, 5])
def test_a_plant_of_several_axes_says_how_rarely_its_sensor_delivers(plate, every):
    loop = replace(plate.scene.loop, optical=replace(plate.scene.loop.optical, every=every))
    scene = SimpleNamespace(rest=plate.scene.rest, loop=loop)
    plant, _ = _coupled_models(SimpleNamespace(scene=scene, source=plate.source), plate.controller.system)
    slow = f"; a sensor that delivers every {every} samples counts as one of more delay" if every > 1 else ""
    assert plant.meaning.endswith(f"the optical error as its sensor delivers it{slow}")


def test_models_that_cannot_be_made_are_refused_with_the_mission(file, monkeypatch):
    def broken(*given):
        raise ValueError("no such mirror")

    monkeypatch.setattr(mirror, "from_mission", broken)
    with pytest.raises(ExportError) as told:
        matrices.models(choice.source(file))
    assert str(told.value) == f"{file.path}: no such mirror"


@pytest.mark.parametrize(
    ("adaptation", "by_difference", "kinds", "words"),
    [
        (None, None, ("command_v",), "PI, as it flies; its"),
        (None, True, ("command_v", "target_rad"), "takes its targets behind it; its"),
        (None, False, ("command_v", "target_rad", "target_rate_rad_s"), "takes its targets behind it; its"),
        (
            "learns",
            False,
            ("command_v", "target_rad", "target_rate_rad_s", "unexpected_error_rad"),
            "expected ones; its",
        ),
    ],
)
def test_a_controller_says_its_limits_and_has_an_output_of_each_kind_for_each_actuator(
    file, adaptation, by_difference, kinds, words
):
    inverse = None if by_difference is None else SimpleNamespace(by_difference=by_difference)
    inputs = (
        SimpleNamespace(name="tip_rad_s", size=2, unit="rad/s"),
        SimpleNamespace(name="gauge_rad", size=1, unit="rad"),
    )
    system = lti.StateSpace(
        np.eye(2) / 2.0, np.ones((2, 3)), np.ones((3 * len(kinds), 2)), np.zeros((3 * len(kinds), 3))
    )
    of = SimpleNamespace(
        **{"name": "PI", "inverse": inverse, "adaptation": adaptation, "inputs": inputs, "actuators": 3},
        **{"minimum_v": -4.5, "maximum_v": 7.25, "period_s": 4e-4, "system": system, "anti_windup": "windup"},
    )
    made = _controller(choice.source(file), of)
    assert made.meaning.endswith(f"{words} commands are clipped to -4.5 .. 7.25 V")
    assert [(p.name, p.unit) for p in made.inputs] == [
        ("tip_rad_s_0", "rad/s"),
        ("tip_rad_s_1", "rad/s"),
        ("gauge_rad_0", "rad"),
    ]
    units = {"target_rate_rad_s": "rad/s", "command_v": "V"}
    assert [(p.name, p.unit) for p in made.outputs] == [
        (f"{kind}_{i}", units.get(kind, "rad")) for kind in kinds for i in range(3)
    ]
    assert (made.period_s, made.anti_windup, [p.name for p in made.states]) == (
        4e-4,
        "windup",
        ["controller_state_0", "controller_state_1"],
    )


def test_models_of_a_mirror_say_where_its_gain_is_taken_and_the_bias_that_they_count_from(file):
    of = choice.source(file)
    table = of.mirror
    linear = table.linear.model_copy(update={"normalise_at_hz": 3.25})
    part, whole = _mirror_models(replace(of, mirror=table.model_copy(update={"linear": linear, "bias_v": 5.5})))
    at = 2j * np.pi * 3.25
    size = abs(np.polyval(linear.numerator, at) / np.polyval(linear.denominator, at))
    assert part.meaning == (
        f"linear part of the mirror, divided by its gain at 3.25 Hz ({size:.6g}); it takes what the hysteresis makes "
        "of the drive"
    )
    assert whole.meaning == (
        "mirror from drive to angle, its hysteresis at its slow gain; both count from rest at 5.5 V"
    )
    ports = [[(p.name, p.unit) for p in (*m.inputs, *m.outputs)] for m in (part, whole)]
    assert ports == [[("hysteresis_rad", "rad"), ("mirror_rad", "rad")], [("drive_v", "V"), ("mirror_rad", "rad")]]
    assert [p.name for p in part.states] == [f"mode_{i}" for i in range(part.system.order)]
    assert [p.name for p in whole.states] == [f"mirror_state_{i}" for i in range(whole.system.order)]
    assert {p.unit for p in (*part.states, *whole.states)} == {"1"} and (part.period_s, whole.period_s) == (0.0, 0.0)


@pytest.mark.parametrize(
    ("poles", "period_s", "worst"),
    [
        ([complex(40.0, 300.0), complex(40.0, -300.0), 0.25], 0.0, "0.03979 Hz with a damping ratio of -1"),
        (
            [complex(2.0, 3.0), complex(2.0, -3.0), complex(1.0, 9.0), complex(1.0, -9.0)],
            0.0,
            "0.5738 Hz with a damping",
        ),
        ([0.5, 1.02, -1.25, 1.1], 0.01, "|z| = 1.25 at 50 Hz"),
        ([complex(0.9, 0.9), complex(0.9, -0.9), 1.2], 0.01, "|z| = 1.27279221 at 12.5 Hz"),
    ],
)
def test_of_several_unstable_poles_the_worst_is_told(poles, period_s, worst):
    system = lti.modal_from_residues(np.array(poles, dtype=complex), np.array([1.0] * len(poles), dtype=complex))
    with pytest.raises(ExportError) as told:
        structure.refuse_unstable(system, period_s, "a loop")
    assert str(told.value).startswith(f"a loop: unstable, {worst}")
    assert str(told.value).endswith(
        ". Coefficients would hide it; take the state space or zeros and poles, or export a stable model"
    )


def test_copies_that_only_others_make_alike_and_chains_that_nothing_reads_go_too():
    """x2 reads x1 = 2 x0, and x3 x0, so that x2 = 6 x3; x5 reads x4, which reads x2, and nothing reads x5."""
    A, B = np.zeros((6, 6)), np.zeros((6, 1))
    B[:2, 0] = 1.0, 2.0
    A[2, 1], A[3, 0], A[4, 2], A[5, 4] = 3.0, 1.0, 1.0, 7.0
    C = np.array([[0.0, 0.0, 1.0, 12.0, 0.0, 0.0]])
    made = without_copies(lti.StateSpace(A, B, C, np.array([[0.5]])))
    assert (made.order, made.D.tolist()) == (2, [[0.5]])
    for power in range(4):
        wanted = (C @ np.linalg.matrix_power(A, power) @ B).item()
        assert (made.C @ np.linalg.matrix_power(made.A, power) @ made.B).item() == pytest.approx(wanted)


@pytest.mark.parametrize(("outputs", "inputs"), [(1, 2), (2, 1), (1, 1)])
def test_forms_of_a_model_stand_in_cells_but_those_of_one_input_and_output(tmp_path, outputs, inputs):
    """Entry (o, i) is k[o, i] / (s + 1 + i), no two k alike."""
    k = 1.0 + np.arange(outputs * inputs).reshape(outputs, inputs)
    A, B = -np.diag(np.arange(1.0, 1.0 + inputs)), np.eye(inputs)
    made = model(A, B, k)
    matrices.write_mat([made], tmp_path / "a.mat")
    record = loadmat(tmp_path / "a.mat")["made"][0, 0]
    for key in ("z", "p", "num", "den"):
        assert (record[key].dtype == object) is (outputs * inputs > 1), key
    if outputs * inputs > 1:
        assert record["p"].shape == record["num"].shape == k.shape
        for o, i in np.ndindex(k.shape):
            assert record["p"][o, i].tolist() == [[-1.0 - i]] and record["num"][o, i][0, -1] == k[o, i]
    else:
        assert record["p"].tolist() == [[-1.0]] and record["num"][0, -1] == k.item()


def test_numbers_of_a_matrix_are_whole_over_one_power_of_two_but_for_what_is_too_small_beside_the_largest():
    """The largest is -4: what is below 2^-198 counts as nothing."""
    matrix = np.array([[-4.0, 0.75, 2.0**-190], [2.0**-199, -(2.0**-197), 0.0]])
    whole, power = matrix_forms._whole(matrix)
    assert power == 197
    assert whole.tolist() == [[-(2**199), 3 * 2**195, 2**7], [0, -1, 0]]
    none, power = matrix_forms._whole(np.zeros((0, 3)))
    assert (none.shape, power) == ((0, 3), 0)
    plain, power = matrix_forms._whole(np.array([[3.0], [-640.0]]))
    assert (plain.tolist(), power) == ([[3], [-640]], 0)


def test_a_form_is_probed_a_decade_beyond_its_roots_or_up_to_half_the_rate():
    """Roots at 0 have no frequency; without another, the band is about 1 Hz."""
    roots = 2.0 * np.pi * np.array([0.0, -3.0, complex(40.0, 30.0), complex(40.0, -30.0), 0.5])
    for found, low, high in ((roots, 0.05, 500.0), (roots[:1], 0.1, 10.0), (roots[:0], 0.1, 10.0)):
        freq, s = matrix_forms._probes(found, 0.0)
        assert (freq[0], freq[-1]) == (pytest.approx(low), pytest.approx(high))
        np.testing.assert_allclose(s, 2j * np.pi * freq, rtol=1e-15)
    freq, z = matrix_forms._probes(roots, 0.25)
    assert (freq[0], freq[-1], freq.size) == (pytest.approx(4e-5), pytest.approx(2.0), s.size)
    np.testing.assert_allclose(z, np.exp(0.5j * np.pi * freq), rtol=1e-12)
    np.testing.assert_allclose(np.diff(np.log(freq)), math.log(5e4) / (freq.size - 1), rtol=1e-9)


@pytest.mark.parametrize(
    ("response", "error", "at_hz"),
    [
        ([2.0, 2.25, -2.0, 2.5], 2.0, 7.0),
        ([2.0, 1.0, 2.5, 2.0], 0.5, 4.0),
        ([2.0, 2.0, 2.0, complex(2.0, 0.5)], 0.25, 9.0),
        ([2.0, 2.5, 2.0, math.nan], math.inf, 9.0),
        ([2.0, 2.5, math.inf, 9.0], math.inf, 7.0),
        ([2.0, 2.0, 2.0, 2.0], 0.0, 1.0),
    ],
)
def test_the_error_of_a_form_is_the_largest_share_that_its_response_is_off(response, error, at_hz):
    gain = lti.StateSpace(np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), np.array([[2.0]]))
    freq = np.array([1.0, 4.0, 7.0, 9.0])
    found = matrix_forms._error(gain, np.array(response, dtype=complex), freq, 0.0)
    assert found == (pytest.approx(error), at_hz)


def test_a_balanced_model_has_the_same_response_with_rows_and_columns_of_like_sizes():
    """Three states in units of their own, two inputs and three outputs."""
    A = np.array([[-1.0, 0.5, 0.0], [0.25, -2.0, 0.75], [0.5, 0.0, -3.0]])
    B, C = (
        np.array([[1.0, 2.0], [0.5, 0.25], [1.5, 1.0]]),
        np.array([[1.0, 0.5, 2.0], [0.0, 1.5, 1.0], [2.0, 1.0, 0.5]]),
    )
    units = np.array([1e-6, 1.0, 1e7])
    given = lti.StateSpace(A / units[:, None] * units, B / units[:, None], C * units, np.zeros((3, 2)))
    a, b, c = structure._balanced(given)
    for s in (0.0, 2j, 1.0 - 1j):
        wanted = C @ np.linalg.solve(s * np.eye(3) - A, B)
        np.testing.assert_allclose(c @ np.linalg.solve(s * np.eye(3) - a, b), wanted, rtol=1e-9)
    sizes = [np.linalg.norm(np.hstack([a, b]), axis=1), np.linalg.norm(np.vstack([a, c]), axis=0)]
    assert np.max(sizes) < 8.0 * np.min(sizes)


def test_models_of_the_paper_are_named_by_what_goes_in_and_comes_out(monkeypatch):
    """The plant behind the drive, and the loop of the setup around the same mirror."""
    asked = []
    plant = lti.StateSpace(np.diag([0.5, 0.25]), np.ones((2, 1)), np.array([[1.0, 2.0]]), np.zeros((1, 1)))
    loop = lti.StateSpace(np.diag([0.5, 0.25, 0.125]), np.ones((3, 1)), np.array([[3.0, 1.0, 2.0]]), np.ones((1, 1)))
    monkeypatch.setattr(control, "sampled_plant", lambda *given: (asked.append(given), plant)[1])
    monkeypatch.setattr(simulate, "sampled_loop", lambda *given: (asked.append(given), loop)[1])
    timing = SimpleNamespace(period_s=0.25)
    setup, origin = SimpleNamespace(timing=timing, drive="drive"), Origin("m", "0" * 64, "tip")
    of = SimpleNamespace(setup=setup, mirror="mirror", source=SimpleNamespace(origin=origin))
    found = _paper_models(of)
    assert asked == [("mirror", "drive", timing), ("mirror", setup)]
    assert [(each.name, each.period_s, each.origin, each.anti_windup) for each in found] == [
        ("sampled_plant", 0.25, origin, None),
        ("loop", 0.25, origin, None),
    ]
    ports = [[(p.name, p.unit) for p in (*each.inputs, *each.outputs, *each.states)] for each in found]
    angle = ("line_of_sight_rad", "rad")
    assert ports == [
        [("command_v", "V"), angle, ("plant_state_0", "1"), ("plant_state_1", "1")],
        [("error_rad", "rad"), angle, *((f"loop_state_{i}", "1") for i in range(3))],
    ]
    for each, wanted in zip(found, (plant, loop), strict=True):
        for key in "ABCD":
            np.testing.assert_array_equal(getattr(each.system, key), getattr(wanted, key))
    assert [each.meaning for each in found] == [
        "computation delay, amplifier and mirror, its hysteresis at its slow gain, at the control samples",
        "loop transfer L, controller and sampled plant in series; the closed loop is L / (1 + L). An inverse acts on "
        "the reference and is no part of it",
    ]


def test_json_of_two_models_has_its_words_as_they_are_in_their_order():
    given = [
        replace(two_by_two(), name="b", meaning='10 µrad \u2190 "V"'),
        replace(two_by_two(), name="a", origin=None),
    ]
    text = matrices.json_text(given)
    assert text.startswith('{\n "format": "microrad linear models",\n "version": 1,\n "microrad": "')
    assert '"meaning": "10 µrad \u2190 \\"V\\""' in text and text.endswith("\n ]\n}\n")
    first, second = json.loads(text)["models"]
    assert [(each["name"], each["mission"] is None, each["mirror"] is None) for each in (first, second)] == [
        ("b", False, False),
        ("a", True, True),
    ]
    assert second["mission_sha256"] is None
