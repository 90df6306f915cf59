"""A loop by itself, without a mission: beside linear theory, the paper's loop, and one axis beside two."""

import math
import os
import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from microrad import mirror as mirrors
from microrad.core import lti
from microrad.loop import control, coupled_study, sine_run
from microrad.loop.disturbance import first_order, fit_spectrum
from microrad.loop.pointing_loop import ensemble, traces
from microrad.loop.pointing_loop.ensemble import Span
from microrad.loop.sensor import OpticalSensor, StrainGauge
from microrad.loop.workbench import Controller, Loop, tune
from microrad.mirror.hysteresis import PrandtlIshlinskii
from microrad.mirror.model import Mirror
from shared import once

LINEAR_PART = ([1.0], [1 / 6000**2, 2 * 0.05 / 6000, 1.0])
STRAIGHT = Mirror.of(50e-6, *LINEAR_PART, name="straight")
PLAYS = PrandtlIshlinskii((0.0, 1.0, 3.0), (40e-6, 6e-6, 4e-6))
BENT = Mirror.of(PLAYS, *LINEAR_PART)
FREQ_HZ = np.geomspace(0.1, 1000, 100)
VIBRATION = once(
    "vibration of the workbench",
    lambda: fit_spectrum(FREQ_HZ, 160e-12 / (1 + FREQ_HZ**2), convention="radial"),
)
LOOP = Loop(mirror=STRAIGHT, rate_hz=10e3, vibration=VIBRATION, sensor_noise_rad=0.2e-6, delay_s=20e-6)
SLOW = Controller.pid(0.0, 5e6, rate_hz=10e3)


def test_runs_scatter_as_linear_theory_says():
    runs = LOOP.ensemble(SLOW, runs=64, duration_s=1.0, settle_s=0.3)
    theory = LOOP.residual_rms_rad(SLOW)
    squares = np.sum(runs.rms_rad**2, axis=1)
    spread = np.std(squares, ddof=1) / np.sqrt(squares.size)
    assert abs(np.mean(squares) - theory[0] ** 2) < 4.5 * spread
    assert spread < 0.05 * theory[0] ** 2
    louder = replace(LOOP, sensor_noise_rad=2e-6).residual_rms_rad(SLOW)
    assert louder[0] > 1.005 * theory[0]


def test_margins_are_those_of_a_dense_nyquist_curve():
    margins = LOOP.margins(SLOW)
    plant = control.sampled_path(STRAIGHT.linear_loop, LOOP.parts.drive, LOOP.parts.timing)
    freq = np.geomspace(1.0, 4999.0, 200_000)
    L = lti.frequency_response(lti.series(SLOW.system, plant), freq, 1e-4)[:, 0, 0]
    assert_allclose(margins.modulus, np.min(np.abs(1 + L)), rtol=1e-4)
    assert margins.modulus < 0.999


def test_a_run_follows_its_reference_as_the_papers_loop_does():
    """Both kernels run the same loop: PID, hysteresis, a delay and an amplifier with limits."""
    wanted = 100e-6 * np.sin(2 * np.pi * 20 * 1e-4 * np.arange(1500))[:, None]
    loop = Loop(
        mirror=BENT,
        rate_hz=10e3,
        delay_s=20e-6,
        drive_range_v=(-1.5, 1.5),
        amplifier_bandwidth_hz=2e3,
        slew_v_s=2000.0,
    )
    run = loop.simulate(SLOW, 0.15, reference_rad=wanted[:, 0])
    drive = control.Drive(-1.5, 1.5, 2e3, 2000.0, 0.0, 0.0)
    setup = sine_run.Setup(drive, control.Timing(1e-4, 10, 2), SLOW.system)
    other = sine_run.track("", BENT, setup, control.no_feedforward(BENT), wanted, slice(0, None))
    assert_allclose(run.reference_rad, wanted, rtol=0, atol=0)
    assert_allclose(run.error_rad, other.error_rad, rtol=0, atol=1e-9 * np.ptp(other.error_rad))
    assert other.counts.saturated > 0
    assert np.max(np.abs(loop.simulate(SLOW, 0.15).error_rad)) == 0.0


@pytest.mark.parametrize(
    "kind", ["PI", *(pytest.param(kind, marks=pytest.mark.endurance) for kind in ("PI + notch", "LQG"))]
)
def test_a_tuned_controller_keeps_its_margin_and_beats_what_was_there(kind):
    tuned = tune(LOOP, kind, modulus_margin=0.55)
    assert tuned.margins.modulus >= 0.55
    assert_allclose(LOOP.margins(tuned.controller).modulus, tuned.margins.modulus, rtol=1e-12)
    assert 0.0 < tuned.residual_rms_rad[0] < LOOP.residual_rms_rad(SLOW)[0]
    looser = tune(LOOP, kind, modulus_margin=0.4)
    assert looser.residual_rms_rad[0] <= tuned.residual_rms_rad[0] * (1 + 1e-6)


@pytest.mark.endurance
def test_two_axes_that_leave_each_other_alone_are_tuned_as_one():
    two = replace(LOOP, mirror=mirrors.combine(STRAIGHT, STRAIGHT))
    one, both = tune(LOOP, "LQG"), tune(two, "LQG")
    assert_allclose(both.residual_rms_rad, np.repeat(one.residual_rms_rad, 2), rtol=1e-4)
    with pytest.raises(ValueError, match=r"is made for 10000 Hz, and this loop has 20000 Hz"):
        replace(two, rate_hz=20e3).margins(both.controller)
    if os.environ.get("MICRORAD_ENDURANCE"):
        shaped = tune(two, "H-infinity")
        assert shaped.margins.modulus >= 0.5 and np.all(shaped.residual_rms_rad > both.residual_rms_rad)
    pid = Controller.pid(0.0, 5e6, rate_hz=10e3, axes=2)
    assert_allclose(two.residual_rms_rad(pid), np.repeat(LOOP.residual_rms_rad(SLOW), 2), rtol=1e-9)


def test_optics_turn_the_outputs_into_line_of_sight():
    doubled = replace(LOOP, optics=[[2.0]])
    half = Controller.pid(0.0, 2.5e6, rate_hz=10e3)
    assert_allclose(doubled.margins(half).modulus, LOOP.margins(SLOW).modulus, rtol=1e-9)


def test_damping_reads_the_gauge():
    gauged = replace(LOOP, gauge_noise_rad=0.05e-6)
    assert tune(gauged, "resonant damping").residual_rms_rad[0] < tune(LOOP, "PI").residual_rms_rad[0]
    with pytest.raises(ValueError, match="gauge"):
        tune(LOOP, "resonant damping")
    s = SLOW.system
    direct = lti.StateSpace(s.A, np.pad(s.B, ((0, 0), (0, 1))), s.C, np.array([[s.D[0, 0], 1.0]]))
    with pytest.raises(ValueError, match="controller 'PID' reads a strain gauge, and this loop has none"):
        LOOP.simulate(replace(SLOW, system=direct), 0.1)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"rate_hz": 0.0}, "rate_hz of a loop is 0.0: give a number above 0"),
        ({"rate_hz": np.inf}, "rate_hz of a loop is inf: give a number above 0"),
        ({"slew_v_s": -1.0}, "slew_v_s of a loop is -1.0"),
        ({"steps_per_sample": 0}, "0 plant steps a sample: give a whole number, 1 or more"),
        ({"steps_per_sample": 2.5}, r"2\.5 plant steps a sample: give a whole number, 1 or more"),
        ({"optics": [[1.0]] * 3}, "3 line-of-sight angles and may have one or two: give optics of one or two rows"),
        ({"drive_range_v": (1.0, 2.0)}, "rest, 0 V, has to lie inside"),
        ({"delay_s": 13e-6}, "loop: its delay of 13 µs is no whole number of plant steps of 10 µs"),
        ({"delay_s": -1e-5}, "loop: delay"),
        ({"sensor_delay_s": 13e-6}, "sensor of the loop: its delay of 13 µs"),
        ({"sensor_noise_rad": -1.0}, "noise_rad"),
        ({"optics": [[1.0, 2.0]]}, r"optics of a loop has shape \(1, 2\): give finite numbers of shape \(axes, 1\)"),
        ({"optics": [[np.nan]]}, r"optics of a loop has shape \(1, 1\): give finite numbers"),
        ({"optics": [[1.0], [1.0]], "gauge_noise_rad": 1e-7}, "one line-of-sight angle for each output"),
    ],
)
def test_a_loop_that_cannot_be_is_refused(changes, said):
    with pytest.raises(ValueError, match=said):
        replace(LOOP, **changes)


@pytest.mark.promise("choose-7")
def test_what_does_not_fit_a_loop_is_refused():
    with pytest.raises(
        ValueError, match=r"controller 'PID' has 2 inputs, 2 outputs .* a loop of 1 axes takes an error"
    ):
        LOOP.margins(Controller.pid(0.0, 1e6, rate_hz=10e3, axes=2))
    for wanted in (np.zeros((3, 2)), np.zeros((3, 1, 1)), [], [0.0, np.nan]):
        said = re.escape(f"reference_rad has shape {np.shape(wanted)}: give finite samples of shape (samples, 1)")
        with pytest.raises(ValueError, match=said):
            LOOP.simulate(SLOW, 0.1, reference_rad=wanted)
    two = mirrors.combine(STRAIGHT, STRAIGHT)
    with pytest.raises(ValueError, match="has 2 actuators and 2 axes: give one axis at a time"):
        control.sampled_plant(two, LOOP.parts.drive, LOOP.parts.timing)
    with pytest.raises(ValueError, match="of one axis with one actuator, not of 1 with 2: design each axis by itself"):
        tune(replace(LOOP, mirror=two, optics=[[1.0, 0.0]]), "PI")
    with pytest.raises(ValueError, match="makes the loop unstable"):
        LOOP.margins(Controller.pid(1e6, rate_hz=10e3))
    with pytest.raises(ValueError, match=r"'H-infinity' cannot be tuned for a loop of one axis: choose one of PI"):
        tune(LOOP, "H-infinity")
    with pytest.raises(ValueError, match=r"modulus_margin is 1\.5: give a number above 0 and below 1"):
        tune(LOOP, "PI", modulus_margin=1.5)
    with pytest.raises(ValueError, match="has no vibration, so that no controller is best"):
        tune(replace(LOOP, vibration=()), "PI")
    with pytest.raises(ValueError, match="make no PID: give finite ones"):
        Controller.pid(np.nan, rate_hz=1e3)
    with pytest.raises(ValueError, match="a PID of 1 axes at 0 Hz"):
        Controller.pid(1.0, rate_hz=0)
    with pytest.raises(ValueError, match=r"gains \(1\.0, 0\.0, 1\.0\) and a filter of -0\.001 s make no PID"):
        Controller.pid(1.0, 0.0, 1.0, rate_hz=1e3, derivative_filter_s=-1e-3)
    with pytest.raises(ValueError, match="a PID of 0 axes at 1000 Hz: give one axis or more"):
        Controller.pid(1.0, rate_hz=1000, axes=0)
    with pytest.raises(ValueError, match="an ensemble of 0 runs"):
        LOOP.ensemble(SLOW, 0, 0.1)


def test_a_mirror_of_parts_answers_and_refuses():
    time_s = 1e-5 * np.arange(3000)
    drive = 5.0 * np.sin(2 * np.pi * 50 * time_s)
    static = Mirror.of(PLAYS)
    assert_allclose(static.response(drive, 1e-5), PLAYS.response(drive, 1e-5), rtol=0, atol=1e-12 * 250e-6)
    response = STRAIGHT.frequency_response([0.0, 6000 / 2 / np.pi])[:, 0, 0]
    assert_allclose(response, [50e-6, -500e-6j], rtol=1e-9, atol=1e-12)
    both = mirrors.combine(STRAIGHT, BENT).response(np.column_stack([drive, drive]), 1e-5)
    assert_allclose(both[:, 1], BENT.response(drive, 1e-5), rtol=0, atol=1e-12 * np.ptp(both))
    for given in (np.column_stack([drive, drive]), drive[:, None, None], [], [1.0, np.nan]):
        said = re.escape(f"drive_v has shape {np.shape(given)}: mirror 'straight' takes finite samples of shape")
        with pytest.raises(ValueError, match=said):
            STRAIGHT.response(given, 1e-5)
    for numerator, denominator in (
        ([1.0, 0.0, 0.0], [1.0, 1.0]),
        ([1.0], [1.0, -1.0]),
        ([1.0, 0.0], [1.0, 2.0, 3.0]),
        ([1.0], [0.0, 1.0, 1.0]),
    ):
        with pytest.raises(ValueError, match="give one that is strictly proper and stable"):
            Mirror.of(1e-6, numerator, denominator)


def test_a_controller_of_another_rate_is_refused_and_a_tuned_one_taken_apart():
    with pytest.raises(ValueError, match=r"controller 'PID' is made for 1000 Hz, and this loop has 10000 Hz"):
        LOOP.simulate(Controller.pid(0.0, 1e6, rate_hz=1e3), 0.1)
    tuned = tune(LOOP, "PI")
    with_no_rate = replace(Controller.pid(0.0, 1e6, rate_hz=1e3), rate_hz=None)
    assert LOOP.simulate(with_no_rate, 0.1).error_rad.shape == (1000, 1)
    with pytest.raises(TypeError, match=r"give its \.controller"):
        LOOP.margins(tuned)
    with pytest.raises(ValueError, match=r"controller 'PI' is made for 10000 Hz, and this loop has 20000 Hz"):
        replace(LOOP, rate_hz=20e3).margins(tuned.controller)
    assert repr(LOOP) == "<Loop of 1 axes at 10000 Hz around mirror 'straight'>"
    assert repr(tuned.controller) == "<Controller 'PI': 2 inputs, 1 outputs, 1 states>"


def test_a_linear_system_is_a_mirror_and_gets_a_controller():
    plain = Mirror.of_system(STRAIGHT.linear_loop, "fitted")
    drive = np.sin(np.arange(500) * 0.05)
    assert_allclose(plain.response(drive, 1e-5), STRAIGHT.response(drive, 1e-5), rtol=0, atol=1e-17)
    loop = replace(LOOP, mirror=plain)
    assert_allclose(loop.residual_rms_rad(SLOW), LOOP.residual_rms_rad(SLOW), rtol=1e-9)
    runs = loop.ensemble(tune(loop, "PI").controller, runs=1, duration_s=0.05)
    assert 0.0 < runs.radial_rms_rad < 20e-6
    with pytest.raises(ValueError, match="linear system of mirror 'fitted' is not stable"):
        Mirror.of_system(lti.StateSpace(np.eye(1), np.eye(1), np.eye(1), np.zeros((1, 1))), "fitted")


def test_a_system_without_states_is_a_mirror():
    static = lti.StateSpace(np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), np.array([[5e-5]]))
    steep = lti.StateSpace(-np.eye(1), np.array([[1e150]]), np.array([[1e150]]), np.zeros((1, 1)))
    with pytest.raises(ValueError, match=r"mirror 'steep' gives no finite output to this drive at a step of 0\.0001 s"):
        Mirror.of_system(steep, "steep").response([0.0, 1e30, 1e30], 1e-4)
    assert_allclose(Mirror.of_system(static).response([1.0, 2.0], 1e-4), [5e-5, 1e-4], rtol=1e-12)


@pytest.mark.parametrize("use", [Loop.margins, Loop.residual_rms_rad, lambda loop, of: loop.simulate(of, 0.01)])
@pytest.mark.parametrize("axes", [1, 2])
@pytest.mark.parametrize("key", ["A", "B", "C", "D", "anti-windup"])
def test_a_controller_with_a_number_that_is_none_is_refused(key, axes, use):
    """With two axes LAPACK said that an array must not contain it, and an anti-windup of it was taken."""
    loop = replace(LOOP, mirror=mirrors.combine(*[STRAIGHT] * axes))
    pid = Controller.pid(0.0, 5e6, rate_hz=10e3, axes=axes)
    if key == "anti-windup":
        wrong = replace(pid, anti_windup=pid.anti_windup * np.nan)
    else:
        wrong = replace(pid, system=replace(pid.system, **{key: getattr(pid.system, key) + np.inf}))
    with pytest.raises(ValueError, match=f"controller 'PID': {key} holds a number that is not finite; look for a gain"):
        use(loop, wrong)


def test_a_delay_of_more_states_than_memory_is_refused():
    mirror = Mirror.of(5e-5, [1.0], [1 / 6000**2, 0.8 / 6000, 1.0])
    with pytest.raises(ValueError, match=r"delay_s of a loop is 1\.0 s, more than 2000 plant steps of 1e-05 s"):
        Loop(mirror=mirror, rate_hz=10e3, delay_s=1.0)


@pytest.mark.parametrize("rate_hz", [5e-324, 1e300])
def test_a_loop_and_a_controller_have_a_rate_that_can_be(rate_hz):
    mirror = Mirror.of(5e-5, [1.0], [1 / 6000**2, 0.8 / 6000, 1.0])
    with pytest.raises(ValueError, match="rate_hz of a loop is"):
        Loop(mirror=mirror, rate_hz=rate_hz)
    for rate, axes in ((rate_hz, 1), (10e3, 1.5)):
        with pytest.raises(ValueError, match="give one axis or more and a rate above 0 Hz"):
            Controller.pid(0.0, 2e6, rate_hz=rate, axes=axes)


@pytest.mark.parametrize(("above", "bound_by"), [(1.001, ("modulus margin",)), (1.1, ())])
def test_a_controller_of_several_axes_just_above_its_margin_is_bound_by_it(monkeypatch, above, bound_by):
    """The search ends a thousandth above the margin that was asked for."""
    two = replace(LOOP, mirror=mirrors.combine(STRAIGHT, STRAIGHT))
    pid = Controller.pid(0.0, 5e6, rate_hz=10e3, axes=2)
    ended = control.WholeController("LQG", pid.system, pid.anti_windup)
    monkeypatch.setattr(coupled_study, "tuned_whole", lambda *given: (ended, {"integral": 5e6}))
    tuned = tune(two, "LQG", modulus_margin=LOOP.margins(SLOW).modulus / above)
    assert_allclose(tuned.margins.modulus, LOOP.margins(SLOW).modulus, rtol=1e-6)
    assert tuned.bound_by == bound_by


COUPLED = lti.StateSpace(
    np.diag([-2600.0, -3100.0]), np.array([[2600.0, 180.0], [150.0, 3100.0]]), np.diag([50e-6, 40e-6]), np.zeros((2, 2))
)
ON_TWO = Loop(mirror=Mirror.of_system(COUPLED, "pair"), rate_hz=10e3, vibration=VIBRATION)
OF_TWO = Controller.pid(0.0, 5e6, rate_hz=10e3, axes=2)


@pytest.mark.parametrize(
    ("call", "error", "words"),
    [
        (lambda: replace(LOOP, rate_hz=-10e3), ValueError, "rate_hz of a loop is -10000.0: give a number above 0"),
        (lambda: replace(LOOP, slew_v_s=0.0), ValueError, "slew_v_s of a loop is 0.0: give a number above 0"),
        (
            lambda: replace(LOOP, amplifier_bandwidth_hz=math.nan),
            ValueError,
            "amplifier_bandwidth_hz of a loop is nan: give a number above 0",
        ),
        (
            lambda: replace(LOOP, steps_per_sample=0),
            ValueError,
            "a loop has 0 plant steps a sample: give a whole number, 1 or more, better 10",
        ),
        (
            lambda: replace(LOOP, drive_range_v=(0.5, 2.5)),
            ValueError,
            "drive_range_v of a loop is (0.5, 2.5) V: rest, 0 V, has to lie inside",
        ),
        (
            lambda: replace(LOOP, delay_s=33e-6),
            ValueError,
            (
                "loop: its delay of 33 µs is no whole number of plant steps of 10 µs: it would end inside "
                "a step; the nearest delay that would do is 30 µs, or choose a plant step that divides it"
            ),
        ),
        (
            lambda: replace(LOOP, sensor_delay_s=-20e-6),
            ValueError,
            (
                "sensor of the loop: delay is -20 µs; give a finite number of at least 0 (it runs from the "
                "middle of the exposure to the delivery)"
            ),
        ),
        (
            lambda: replace(LOOP, sensor_delay_s=0.25),
            ValueError,
            (
                "sensor_delay_s of a loop is 0.25 s, more than 2000 plant steps of 1e-05 s, each of them a "
                "state: give a shorter one, or fewer steps per sample"
            ),
        ),
        (
            lambda: replace(ON_TWO, optics=[[1.0, 0.5, 2.0]]),
            ValueError,
            (
                "optics of a loop has shape (1, 3): give finite numbers of shape (axes, 2), a row for each "
                "line-of-sight angle"
            ),
        ),
        (
            lambda: replace(ON_TWO, optics=[[1.0, math.inf], [0.0, 1.0]]),
            ValueError,
            (
                "optics of a loop has shape (2, 2): give finite numbers of shape (axes, 2), a row for each "
                "line-of-sight angle"
            ),
        ),
        (
            lambda: replace(ON_TWO, optics=[[1.0, 0.5]], gauge_noise_rad=1e-9),
            ValueError,
            "a loop with a gauge needs one line-of-sight angle for each output of the mirror",
        ),
        (
            lambda: Controller.pid(math.inf, 5e6, 0.25, rate_hz=10e3),
            ValueError,
            "gains (inf, 5000000.0, 0.25) and a filter of 0.0 s make no PID: give finite ones",
        ),
        (
            lambda: Controller.pid(1.0, 5e6, 0.25, rate_hz=10e3, derivative_filter_s=-1e-3),
            ValueError,
            "gains (1.0, 5000000.0, 0.25) and a filter of -0.001 s make no PID: give finite ones",
        ),
        (
            lambda: Controller.pid(1.0, 5e6, rate_hz=0.0, axes=2),
            ValueError,
            "a PID of 2 axes at 0.0 Hz: give one axis or more and a rate above 0 Hz",
        ),
        (
            lambda: LOOP.margins(Controller.pid(0.0, 5e6, rate_hz=8e3)),
            ValueError,
            "controller 'PID' is made for 8000 Hz, and this loop has 10000 Hz: make one for this rate",
        ),
        (
            lambda: ON_TWO.residual_rms_rad(SLOW),
            ValueError,
            (
                "controller 'PID' has 1 inputs, 1 outputs and an anti-windup of shape (1, 1): a loop of 2 "
                "axes takes an error and gives a command for each, and an anti-windup of shape (1, 2)"
            ),
        ),
        (
            lambda: LOOP.residual_rms_rad(OF_TWO),
            ValueError,
            (
                "controller 'PID' has 2 inputs, 2 outputs and an anti-windup of shape (2, 2): a loop of 1 "
                "axes takes an error and gives a command for each, and an anti-windup of shape (2, 1)"
            ),
        ),
        (
            lambda: LOOP.residual_rms_rad(replace(SLOW, anti_windup=SLOW.anti_windup * math.nan)),
            ValueError,
            (
                "controller 'PID': anti-windup holds a number that is not finite; look for a gain that is "
                "nan or infinite"
            ),
        ),
        (
            lambda: LOOP.residual_rms_rad(replace(SLOW, anti_windup=np.ones((3, 2)))),
            ValueError,
            (
                "controller 'PID' has 1 inputs, 1 outputs and an anti-windup of shape (3, 2): a loop of 1 "
                "axes takes an error and gives a command for each, and an anti-windup of shape (1, 1)"
            ),
        ),
        (
            lambda: LOOP.simulate(SLOW, 0.1, reference_rad=np.zeros((5, 2))),
            ValueError,
            "reference_rad has shape (5, 2): give finite samples of shape (samples, 1)",
        ),
        (
            lambda: ON_TWO.simulate(OF_TWO, 0.1, reference_rad=[[0.0, math.nan]]),
            ValueError,
            "reference_rad has shape (1, 2): give finite samples of shape (samples, 2)",
        ),
        (
            lambda: tune(LOOP, "H-infinity"),
            ValueError,
            (
                "'H-infinity' cannot be tuned for a loop of one axis: choose one of PI, PI + notch, "
                "resonant damping, disturbance observer, LQG"
            ),
        ),
        (
            lambda: tune(ON_TWO, "PI + notch"),
            ValueError,
            "'PI + notch' cannot be tuned for a loop of 2 axes: choose one of LQG, H-infinity",
        ),
        (
            lambda: tune(LOOP, "PI", modulus_margin=1.25),
            ValueError,
            "modulus_margin is 1.25: give a number above 0 and below 1, such as 0.5",
        ),
        (
            lambda: tune(replace(ON_TWO, vibration=()), "LQG"),
            ValueError,
            "the loop has no vibration, so that no controller is best: give it one, see fit_spectrum",
        ),
    ],
)
def test_a_refusal_of_a_loop_says_its_numbers(call, error, words):
    with pytest.raises(error) as refused:
        call()
    assert str(refused.value) == words


HUM = first_order(9e-12, 3.0, convention="radial", name="hum")
ROLL = first_order(2e-12, 11.0, convention="per-axis", name="roll")
UNLIKE = {
    "rate_hz": 8e3,
    "vibration": (HUM, ROLL),
    "sensor_noise_rad": 0.3e-6,
    "delay_s": 25e-6,
    "sensor_delay_s": 62.5e-6,
    "amplifier_bandwidth_hz": 3e3,
}
SKEW = Loop(mirror=Mirror.of_system(COUPLED, "pair"), optics=[[1.3, 0.2], [-0.1, 0.8]], **UNLIKE)
ALONE = Loop(mirror=STRAIGHT, optics=[[1.3]], **UNLIKE)
GAINS = {"rate_hz": 8e3, "derivative_filter_s": 2e-4}
BOTH, SINGLE = (Controller.pid(0.3e3, 4e6, 0.05, axes=axes, **GAINS) for axes in (2, 1))


@pytest.mark.parametrize(("found", "expected"), [
    (lambda: SKEW.residual_rms_rad(BOTH) * 1e6, [3.98212655, 3.96351713]),
    (lambda: [SKEW.margins(BOTH).modulus, ALONE.margins(SINGLE).modulus,
            ALONE.residual_rms_rad(SINGLE)[0] * 1e6],
     [0.956161364, 0.474011861, 2.99408245]),
    (lambda: [*SINGLE.system.A.ravel(), *SINGLE.system.B.ravel(), *SINGLE.system.C.ravel(),
            *SINGLE.system.D.ravel(), *SINGLE.anti_windup.ravel()],
     [
        1.0, 0.0, 0.0, 0.615384615, 500.0, 0.384615385, 1.0, -153.846154, 953.846154, 0.524193548,
        0.000403225806,
    ]),
    (lambda: [SKEW.parts.timing.delay_steps, SKEW.parts.optical.delay_steps,
            SKEW.parts.timing.steps_per_sample, SKEW.parts.timing.period_s, SKEW.axes],
     [2, 5, 10, 0.000125, 2]),
])  # fmt: skip
def test_loops_of_numbers_unlike_each_other(found, expected):
    assert list(found()) == pytest.approx(expected, rel=1e-6, abs=0.0, nan_ok=True)


@pytest.mark.parametrize(
    ("found", "expected"),
    [
        (
            lambda: [repr(SKEW), repr(ALONE), repr(BOTH), repr(SINGLE)],
            [
                "<Loop of 2 axes at 8000 Hz around mirror 'pair'>",
                "<Loop of 1 axes at 8000 Hz around mirror 'straight'>",
                "<Controller 'PID': 2 inputs, 2 outputs, 4 states>",
                "<Controller 'PID': 1 inputs, 1 outputs, 2 states>",
            ],
        ),
    ],
)
def test_loops_and_controllers_are_shown_with_their_names(found, expected):
    assert found() == expected


@pytest.mark.parametrize("seconds", [math.nan, math.inf, -math.inf])
def test_a_run_of_seconds_that_are_not_finite_is_refused(seconds):
    with pytest.raises(ValueError, match=f"a run of {seconds:g} s that settles for 0 s: give finite seconds"):
        LOOP.simulate(SLOW, seconds)
    with pytest.raises(ValueError, match=f"a run of 1 s that settles for {seconds:g} s: give finite seconds"):
        LOOP.ensemble(SLOW, 1, 1.0, settle_s=seconds)


def test_a_loop_has_each_of_its_numbers_where_the_simulation_takes_them():
    loop = replace(ALONE, gauge_noise_rad=7e-9, drive_range_v=(-4.0, 9.0), slew_v_s=350.0, steps_per_sample=5,
                   sensor_delay_s=50e-6)  # fmt: skip
    found, period = loop.parts, 1.25e-4
    assert found.drive == control.Drive(-4.0, 9.0, 3e3, 350.0, 0.0, 0.0)
    assert found.timing == control.Timing(period, 5, 1)
    assert found.optical == OpticalSensor(0.3e-6, math.inf, 0.0, 1, 2)
    assert found.gauge == StrainGauge(7e-9, 0.0)
    assert found.disturbances == ((HUM, ROLL),)
    assert (found.mirror is STRAIGHT, found.optics.tolist(), found.held, found.unknown) == (True, [[1.3]], None, ())
    assert SKEW.parts.disturbances == ((HUM, ROLL),) * 2
    assert (SKEW.parts.gauge, SKEW.parts.drive.slew_v_s, len(SKEW.parts.references)) == (None, math.inf, 2)
    plain = Loop(mirror=STRAIGHT, rate_hz=2e3)
    assert plain.parts.drive == control.Drive(-math.inf, math.inf, math.inf, math.inf, 0.0, 0.0)
    assert (plain.parts.timing, plain.parts.optical) == (
        control.Timing(5e-4, 10, 0), OpticalSensor(0.0, math.inf, 0.0, 1, 0)
    )  # fmt: skip
    assert (plain.parts.disturbances, plain.parts.gauge) == (((),), None)


@pytest.mark.parametrize("axes", [1, 2])
def test_a_run_follows_each_sample_of_its_reference_and_holds_the_last(axes):
    loop = LOOP if axes == 1 else ON_TWO
    quiet = replace(loop, vibration=(), sensor_noise_rad=0.0)
    samples = 1e-6 * np.arange(1.0, 1.0 + 3 * axes).reshape(3, axes)
    found = quiet.simulate(Controller.pid(0.0, 5e6, rate_hz=10e3, axes=axes), 8e-4, reference_rad=samples)
    assert_allclose(found.reference_rad, samples[[0, 1, 2, 2, 2, 2, 2, 2]], rtol=1e-12)
    if axes == 1:
        again = quiet.simulate(SLOW, 8e-4, reference_rad=samples[:, 0].tolist())
        assert (again.error_rad == found.error_rad).all()
    assert not quiet.simulate(Controller.pid(0.0, 5e6, rate_hz=10e3, axes=axes), 8e-4).reference_rad.any()


def test_an_ensemble_is_of_the_runs_seconds_and_seed_that_are_asked_for(monkeypatch):
    asked = []
    monkeypatch.setattr(ensemble, "simulate", lambda *given, **more: asked.append((*given[2:], more)) or "runs")
    monkeypatch.setattr(traces, "trace", lambda *given: asked.append(given[2:]) or "run")
    assert LOOP.ensemble(SLOW, 7, 2.5, settle_s=0.5, seed=11, on_progress=print) == "runs"
    assert LOOP.ensemble(SLOW, 3, 1.5) == "runs"
    assert LOOP.simulate(SLOW, 3.5, seed=4) == "run"
    spans = [Span(2.5, 0.5, 11), Span(1.5, 0.0, 0), Span(3.5, 0.0, 4)]
    assert [each[0] for each in asked] == spans
    assert [each[1] for each in asked[:2]] == [7, 3]
    assert asked[0][2] == {"on_progress": print}


def test_what_is_tuned_for_is_handed_on_and_comes_back_as_a_controller_of_the_loop(monkeypatch):
    asked, told = [], []
    one = control.AxisController("own", lti.StateSpace(np.eye(1), np.ones((1, 2)), np.ones((1, 1)), np.zeros((1, 2))),
                                 np.zeros((1, 1)))  # fmt: skip
    found = SimpleNamespace(controller=one, values={"zero": 3.0}, margins="margins", bound_by=("zero at its most",))
    monkeypatch.setattr(control, "tune", lambda *given, **more: asked.append((*given, more)) or found)
    monkeypatch.setattr(Loop, "residual_rms_rad", lambda self, made: made.name)
    gauged = replace(LOOP, gauge_noise_rad=1e-9)
    for kind in ("PI", "PI + notch", "resonant damping", "disturbance observer", "LQG"):
        tuned = tune(gauged, kind, modulus_margin=0.375, seed=5, on_progress=told.append)
        assert (tuned.controller.name, tuned.residual_rms_rad) == (kind, kind)
        assert (tuned.controller.system, tuned.controller.rate_hz) == (one.system, 10e3)
        assert (tuned.values, tuned.margins, tuned.bound_by) == ({"zero": 3.0}, "margins", ("zero at its most",))
        family, plants, wanted, more = asked.pop()
        assert (family.name, len(plants), plants[0].has_gauge) == (kind, 1, True)
        assert (wanted, more) == (control.Specification(0.375), {"seed": 5, "on_progress": told.append})
    tune(LOOP)
    family, _, wanted, more = asked.pop()
    assert (family.name, wanted, more["seed"]) == ("LQG", control.Specification(0.5), 0)


@pytest.mark.parametrize("kind", ["LQG", "H-infinity"])
def test_a_controller_of_several_axes_is_tuned_as_one_and_told_once(monkeypatch, kind):
    asked, said = [], []
    made = control.WholeController(kind, OF_TWO.system, OF_TWO.anti_windup)
    monkeypatch.setattr(coupled_study, "tuned_whole", lambda *given: asked.append(given) or (made, {"a": 2.0}))
    tuned = tune(ON_TWO, kind, modulus_margin=0.25, on_progress=lambda *each: said.append(each))
    ((family, plants, wanted),) = asked
    assert (family.name, len(plants), plants[0].axes, wanted) == (kind, 1, 2, control.Specification(0.25))
    assert said == [(1, 1, f"tune {kind}")]
    assert (tuned.controller.name, tuned.controller.rate_hz, tuned.values) == (kind, 10e3, {"a": 2.0})
    assert_allclose(tuned.residual_rms_rad, ON_TWO.residual_rms_rad(OF_TWO), rtol=1e-9)


@pytest.mark.parametrize("axes", [1, 2, 3])
def test_a_pid_of_several_axes_is_the_same_on_each_and_acts_on_no_other(axes):
    one = control.pid(control.Gains(300.0, 4e6, 0.05, 2e-4), 1.0 / 8e3)
    made = Controller.pid(0.3e3, 4e6, 0.05, axes=axes, **GAINS)
    assert (made.name, made.rate_hz) == ("PID", 8e3)
    for key in "ABCD":
        assert_allclose(getattr(made.system, key), np.kron(np.eye(axes), getattr(one, key)), rtol=1e-12)
    assert_allclose(made.anti_windup, np.kron(np.eye(axes), one.B / one.D), rtol=1e-9)
    plain = Controller.pid(5.0, rate_hz=100.0)
    assert (plain.system.order, plain.system.D.tolist()) == (0, [[5.0]])


def test_disturbances_in_a_list_are_added_up_as_those_in_a_tuple():
    listed = replace(ALONE, vibration=[HUM, ROLL])
    assert listed.residual_rms_rad(SINGLE) == pytest.approx(ALONE.residual_rms_rad(SINGLE), rel=1e-12)


def test_one_row_of_samples_is_no_reference_of_two_axes():
    with pytest.raises(ValueError, match=re.escape("shape (6,): give finite samples of shape (samples, 2)")):
        ON_TWO.simulate(OF_TWO, 0.1, reference_rad=np.zeros(6))


def test_a_gauge_without_noise_is_a_gauge():
    perfect, none = replace(LOOP, gauge_noise_rad=0.0), replace(LOOP, gauge_noise_rad=None)
    assert (perfect.parts.gauge, none.parts.gauge) == (StrainGauge(0.0, 0.0), None)
    s = SLOW.system
    reads = replace(SLOW, system=lti.StateSpace(s.A, np.pad(s.B, ((0, 0), (0, 1))), s.C, np.array([[s.D[0, 0], 0.5]])))
    assert perfect.assembled(reads).system.D[0, 1] == pytest.approx(0.5)
    with pytest.raises(ValueError, match="controller 'PID' reads a strain gauge, and this loop has none"):
        none.assembled(reads)
    with pytest.raises(ValueError, match="needs one line-of-sight angle for each output of the mirror"):
        replace(LOOP, optics=[[1.0], [1.0]], gauge_noise_rad=0.0)


@pytest.mark.parametrize(
    ("given", "shown"),
    [((-0.5, 0.25), None), ((-0.25, math.inf), None), ((0.0, 1.0), "(0.0, 1.0)"), ((-1.0, 0.0), "(-1.0, 0.0)"),
     ((-2.0, -0.5), "(-2.0, -0.5)"), ((math.nan, 1.0), "(nan, 1.0)"), ((-1.0, math.nan), "(-1.0, nan)")],
)  # fmt: skip
def test_a_drive_range_of_less_than_a_volt_is_one_and_rest_at_its_end_is_none(given, shown):
    if shown is None:
        found = replace(LOOP, drive_range_v=given).parts.drive
        assert (found.minimum_v, found.maximum_v) == given
        return
    with pytest.raises(ValueError) as refused:
        replace(LOOP, drive_range_v=given)
    assert str(refused.value) == f"drive_range_v of a loop is {shown} V: rest, 0 V, has to lie inside"


@pytest.mark.parametrize("loop", [LOOP, ON_TWO], ids=["one axis", "two axes"])
@pytest.mark.parametrize("margin", [0.0, 1.0, -0.5, math.nan])
def test_a_margin_of_nothing_or_of_all_cannot_be_tuned_for(loop, margin):
    with pytest.raises(ValueError) as refused:
        tune(loop, modulus_margin=margin)
    assert str(refused.value) == f"modulus_margin is {margin}: give a number above 0 and below 1, such as 0.5"


@pytest.mark.parametrize(
    ("name", "value"),
    [("rate_hz", math.nan), ("rate_hz", -2e3), ("amplifier_bandwidth_hz", 0.0), ("amplifier_bandwidth_hz", math.nan),
     ("amplifier_bandwidth_hz", -math.inf), ("slew_v_s", math.nan), ("slew_v_s", 0.0)],
)  # fmt: skip
def test_a_number_of_a_loop_that_is_not_above_0_is_refused_by_its_name(name, value):
    with pytest.raises(ValueError) as refused:
        replace(LOOP, **{name: value})
    assert str(refused.value) == f"{name} of a loop is {value}: give a number above 0"
    assert replace(LOOP, amplifier_bandwidth_hz=math.inf, slew_v_s=math.inf).axes == 1


@pytest.mark.parametrize("rate_hz", [20e3, 10e3 * (1 + 1e-8), 5e3, 10e3 * (1 - 1e-8)])
def test_a_controller_of_a_faster_or_a_slower_rate_is_refused(rate_hz):
    with pytest.raises(ValueError, match=r"^controller 'PID' is made for .* Hz, and this loop has 10000 Hz: make one"):
        LOOP.margins(Controller.pid(0.0, 5e6, rate_hz=rate_hz))
    assert LOOP.margins(Controller.pid(0.0, 5e6, rate_hz=10e3 * (1 + 1e-11))) is not None


@pytest.mark.parametrize(
    ("low", "high"),
    [(-2.0, -1.0), (1.0, 2.0), (0.0, 1.0), (-1.0, 0.0), (1.0, -1.0), (math.nan, 1.0), (-1.0, math.nan)],
)
def test_rest_has_to_lie_between_both_ends_of_the_drive(low, high):
    said = re.escape(f"drive_range_v of a loop is ({low}, {high}) V: rest, 0 V, has to lie inside")
    with pytest.raises(ValueError, match=said):
        replace(LOOP, drive_range_v=(low, high))
    assert replace(LOOP, drive_range_v=(-1e-3, 2.0)).drive_range_v == (-1e-3, 2.0)


@pytest.mark.parametrize("value", [0.0, -1.0, math.nan, -math.inf])
@pytest.mark.parametrize("name", ["rate_hz", "amplifier_bandwidth_hz", "slew_v_s"])
def test_each_rate_of_a_loop_is_a_number_above_nothing(name, value):
    with pytest.raises(ValueError, match=f"^{name} of a loop is {value}: give a number above 0$"):
        replace(LOOP, **{name: value})


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"sensor_delay_s": 1.0}, r"sensor_delay_s of a loop is 1\.0 s, more than 2000 plant steps of 1e-05 s"),
        ({"delay_s": math.nan}, r"delay_s of a loop is nan s, more than 2000"),
        ({"steps_per_sample": -1}, r"-1 plant steps a sample: give a whole number, 1 or more"),
        ({"optics": [[math.inf]]}, r"optics of a loop has shape \(1, 1\): give finite numbers of shape \(axes, 1\)"),
        ({"optics": [[-math.inf]]}, r"optics of a loop has shape \(1, 1\): give finite numbers of shape \(axes, 1\)"),
        (
            {"mirror": mirrors.combine(STRAIGHT, STRAIGHT), "optics": [[1.0]]},
            r"optics of a loop has shape \(1, 1\): give finite numbers of shape \(axes, 2\)",
        ),
        (
            {"mirror": mirrors.combine(STRAIGHT, STRAIGHT), "optics": [[1.0, 0.0]], "gauge_noise_rad": 1e-7},
            "a loop with a gauge needs one line-of-sight angle for each output of the mirror",
        ),
    ],
)
def test_a_loop_with_too_few_or_endless_parts_is_refused(changes, said):
    with pytest.raises(ValueError, match=said):
        replace(LOOP, **changes)


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("place", [0, 1, 2, 3])
def test_each_gain_and_the_filter_of_a_pid_are_finite(place, value):
    given = [1.0, 2.0, 3.0, 0.5]
    given[place] = value
    said = re.escape(f"gains {tuple(given[:3])} and a filter of {given[3]} s make no PID: give finite ones")
    with pytest.raises(ValueError, match=f"^{said}$"):
        Controller.pid(*given[:3], rate_hz=1e3, derivative_filter_s=given[3])


@pytest.mark.parametrize(
    ("axes", "rate_hz"), [(-1, 1e3), (1, -1e3), (1, math.nan), (1, math.inf), (2.0, 1e3), (math.nan, 1e3)]
)
def test_a_pid_has_whole_axes_and_a_rate_with_an_end(axes, rate_hz):
    with pytest.raises(ValueError, match=f"^a PID of {axes} axes at {rate_hz} Hz: give one axis or more and a rate"):
        Controller.pid(1.0, rate_hz=rate_hz, axes=axes)


@pytest.mark.parametrize("margin", [0.0, 1.0, -0.5, 2.0, math.nan, math.inf])
def test_a_modulus_margin_lies_between_nothing_and_one(margin):
    with pytest.raises(ValueError, match=f"^modulus_margin is {re.escape(str(margin))}: give a number above 0 and"):
        tune(LOOP, "PI", modulus_margin=margin)


def test_a_controller_of_fewer_axes_than_its_loop_is_refused_as_one_of_more_is():
    two = replace(LOOP, mirror=mirrors.combine(STRAIGHT, STRAIGHT))
    for axes in (1, 3):
        said = f"controller 'PID' has {axes} inputs, {axes} outputs and an anti-windup of shape \\({axes}, {axes}\\)"
        with pytest.raises(ValueError, match=f"^{said}: a loop of 2 axes takes an error and gives a command for each"):
            two.margins(Controller.pid(0.0, 1e6, rate_hz=10e3, axes=axes))


@pytest.mark.parametrize("wanted", [[0.0, math.inf], [-math.inf, 0.0], np.full((3, 2), 1e-6), np.zeros((0, 1))])
def test_a_reference_without_an_end_or_of_another_shape_is_refused(wanted):
    said = re.escape(f"reference_rad has shape {np.shape(wanted)}: give finite samples of shape (samples, 1)")
    with pytest.raises(ValueError, match=said):
        LOOP.simulate(SLOW, 0.1, reference_rad=wanted)


@pytest.mark.parametrize("runs", [0, -1])
def test_runs_are_one_at_least(runs):
    with pytest.raises(ValueError, match=f"^an ensemble of {runs} runs has no statistics: ask for 1 run or more$"):
        LOOP.ensemble(SLOW, runs, 0.1)
