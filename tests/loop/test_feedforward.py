"""Feedforward for hysteretic stiffness: against a slow twin, theory and its alternatives; what it leaves, refusals."""

import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from numpy.testing import assert_allclose

import oracles
from hysteretic_springs import FAMILIES, RAD_V, driven, idle, on_springs, quiet, sines, with_errors
from learning_loops import in_series, loop_of
from microrad.core import lti
from microrad.loop import control, coupled_study
from microrad.loop.control import AxisController
from microrad.loop.disturbance import Reference
from microrad.loop.pointing_loop import ensemble, linear, traces
from microrad.loop.pointing_loop.ensemble import Span
from microrad.loop.pointing_loop.feedforward import with_feedforward
from microrad.loop.pointing_loop.kernel_arrays import arrays
from microrad.loop.pointing_loop.loop import (
    ReferenceFilter,
    assemble,
    decoupling,
    nominal_axis_gain,
    with_inverse,
)
from microrad.mirror.hysteresis import BoucWen, PrandtlIshlinskii, rest_gain
from microrad.mirror.model import Mirror, linearised
from several_axes import mission, scene_of, three_actuators

PATH = ReferenceFilter(1000.0)
URAD = 1e-6
SPAN = Span(0.5, 0.2, 1)
each_family = pytest.mark.parametrize("family", FAMILIES)


@cache
def scene(family):
    """Two axes on springs, with sines, a point-ahead and a slow rate."""
    made = scene_of(on_springs(FAMILIES[family]))
    given = sines(71 * URAD, 2.55 * URAD)
    rest = replace(made.rest, references=given)
    return replace(made, loop=replace(made.loop, references=given), linear=(rest, *made.linear[1:]))


def integral(scene, crossover_hz=25.0):
    """An integrator on each axis: a feedback that is no matter of tuning."""
    gain = 2 * math.pi * crossover_hz * scene.loop.timing.period_s / nominal_axis_gain(scene.rest)
    columns = np.array([[1.0, 0.0]])
    system = lti.StateSpace(np.eye(1), columns, np.array([[gain]]), gain * columns)
    return assemble("I", scene.rest, AxisController("I", system, np.array([[1.0 / gain]])))


def forward(scene, feedback=None):
    return with_feedforward("ahead", scene.loop, feedback or integral(scene), PATH)


def rms(loop, controller, span=SPAN):
    return ensemble.simulate(loop, controller, span, 1).axis_rms_rad[:2]


# ------------------------------------------------------------------------------------------------------- the slow twin
def ahead_twin(loop, delays_s, samples):
    """Where the line of sight is to be: a critically damped filter's exact steps, and its rate times the delays."""
    w, period = 2 * math.pi * PATH.bandwidth_hz, loop.timing.period_s
    decay = math.exp(-w * period)
    target, rate = np.zeros(loop.axes), np.zeros(loop.axes)
    found = []
    for k in range(samples):
        r = np.array([each.at(k * period) for each in loop.references])
        off, slope = target - r, rate + w * (target - r)
        target = r + (off + slope * period) * decay
        rate = (slope - w * (off + slope * period)) * decay
        found.append(target + delays_s @ rate)
    return np.array(found)


def springs_twin(model, q):
    """What a spring gives for the motion q, sample by sample."""
    if isinstance(model, BoucWen):
        h, before, found = 0.0, 0.0, []
        for now in q.tolist():
            slope = model.epsilon_rad_v
            h = oracles.bouc_wen_step(h, now - before, slope, model.alpha_1_v, model.beta_1_v)
            found.append(h)
            before = now
        return np.array(found)
    plays = oracles.play_response(q, model.thresholds_v, np.zeros(len(model.thresholds_v)))
    s = np.clip(q / model.reach_v, -1.0, 1.0)
    return plays @ model.weights_rad_v + np.column_stack([s**2, np.abs(s) * s, s**3]) @ model.polynomial_rad


def measured_delays(loop):
    """All delays over the filter's gain for the rate, and that gain: from responses at 0.5 Hz, without a derivative."""
    freq = np.array([0.5])
    s, period = PATH.discrete(loop.timing.period_s), loop.timing.period_s
    filtered, rate = lti.frequency_response(s, freq, period)[0, :, 0]
    still = replace(loop, references=(Reference(0.0, 0.0, 1.0),) * loop.axes)
    plant = coupled_study.designs.whole_plant(still, decoupling(loop)).system
    seen = lti.StateSpace(
        plant.A, plant.B[:, : loop.axes], -plant.C[: loop.axes], 0 * plant.D[: loop.axes, : loop.axes]
    )
    answer = lti.frequency_response(seen, freq, period)[0] / nominal_axis_gain(loop)
    w = 2 * math.pi * freq[0]
    return (-np.angle(filtered) / w * np.eye(loop.axes) - answer.imag / w) / (abs(rate) / w), abs(rate) / w


@pytest.mark.promise("hysteretic-stiffness-16")
@pytest.mark.promise("pointing-84", "pointing-91")
@each_family
@pytest.mark.promise("pointing-99")
def test_commands_are_those_of_the_slow_twin(family):
    """Without feedback, sample by sample; the springs' algebra about rest by hand, as each axis has its own spring."""
    found = scene(family)
    loop, rest = quiet(found.loop), quiet(found.rest)
    controller = forward(found, idle(loop))
    commands = traces.replay(loop, controller, 1500, 1).commands
    delays, of_rate = measured_delays(rest)
    assert_allclose(np.diag(delays) * of_rate, 0.69e-3, rtol=0.03)
    ahead = ahead_twin(loop, delays, 1500)
    m = loop.mirror
    strain = np.linalg.solve(m.C[:, ::2], ahead.T).T  # the line of sight fixes the strains
    stiffness = -m.B[1::2] / m.E[1::2].sum(axis=1)[:, None]  # B u = strain - z: what drives do, in units of the spring
    assert np.abs(np.linalg.solve(-m.A, m.B)[::2] + stiffness).max() < 1e-12
    forces = np.column_stack([springs_twin(model, strain[:, e]) for e, model in enumerate(m.bank)])
    expected = np.linalg.solve(-stiffness, (strain - forces).T).T
    assert np.abs(expected).max() > 10.0
    assert_allclose(commands, expected, rtol=0, atol=2e-5 * np.abs(expected).max())  # of delays by a difference


# ----------------------------------------------------------------------------------------------------- what it leaves
@pytest.mark.promise("hysteretic-stiffness-16")
@pytest.mark.promise("pointing-85")
@each_family
@pytest.mark.promise("pointing-99")
def test_slow_motions_of_one_axis_are_followed_exactly(family):
    """One axis without feedback: the spring's force is made up for, and a gain alone is not enough."""
    model = FAMILIES[family]
    s, w = -80.0, 4000.0
    push = np.array([[0.0], [-(s * s + w * w) / w]])
    bank = {"bouc_wen": (model,), "plays": ()} if isinstance(model, BoucWen) else {"bouc_wen": (), "plays": (model,)}
    none = np.zeros((1, 1))
    mirror = Mirror(
        "one spring",
        lti.modal_matrix([(s, w)]),
        push,
        push,
        np.array([[1.0, 0.0]]),
        none,
        np.array([[20 * URAD, 0.0]]),
        none,
        none,
        inverse=(),
        **bank,
    )
    base = quiet(scene(family).loop)
    axis = replace(
        base,
        mirror=mirror,
        optics=np.eye(1),
        disturbances=((),),
        references=(Reference(0.0, 0.0, 1.0, 300 * URAD, 2.0),),
    )
    span = Span(1.5, 0.5, 1)
    left = ensemble.simulate(axis, with_feedforward("ahead", axis, idle(axis), PATH), span, 1).axis_rms_rad[0]
    straight = replace(axis, mirror=linearised(mirror, [rest_gain(model)]))
    gain_alone = with_feedforward("gain", straight, idle(axis), PATH)
    beside = ensemble.simulate(axis, gain_alone, span, 1).axis_rms_rad[0]
    print(f"{family}: {left / URAD:.4f} of {300 / math.sqrt(2):.0f} µrad, by the gain alone {beside / URAD:.2f}")
    assert left < 1e-4 * 300 * URAD < 0.05 * 300 * URAD < beside


@each_family
def test_it_leaves_a_tenth_of_what_a_linear_feedforward_leaves_and_a_thirtieth_of_feedback_alone(family):
    found = scene(family)
    loop, feedback = quiet(found.loop), integral(found)
    straight = replace(loop, mirror=linearised(loop.mirror, [rest_gain(model) for model in loop.mirror.bank]))
    left = rms(loop, forward(found))
    by_gain = rms(loop, with_feedforward("gain", straight, feedback, PATH))
    alone = rms(loop, feedback)
    print(family, left / URAD, by_gain / URAD, alone / URAD)
    assert np.all(left < 0.15 * by_gain)
    assert np.all(left < 0.03 * alone)


@pytest.mark.promise("pointing-85")
def test_springs_that_bend_more_than_the_line_of_sight_are_made_up_for_to_first_order():
    """Three actuators, and modes that all of them excite: slow motions, without feedback."""
    made = scene_of(three_actuators(0.05))
    slow = tuple(Reference(0.0, 0.0, 1.0, 100 * URAD, 2.0) for _ in "xy")
    loop = quiet(replace(made.loop, references=slow))
    straight = replace(loop, mirror=linearised(loop.mirror, [rest_gain(model) for model in loop.mirror.bank]))
    span = Span(1.5, 0.5, 1)
    left = rms(loop, with_feedforward("ahead", loop, idle(loop), PATH), span)
    by_gain = rms(loop, with_feedforward("gain", straight, idle(loop), PATH), span)
    print(left / URAD, by_gain / URAD)
    assert np.all(left < 0.1 * by_gain)
    assert np.all(by_gain > 0.02 * 100 * URAD)


@pytest.mark.promise("pointing-84")
def test_what_its_lead_leaves_is_of_second_order_in_the_delay():
    """On a straight mirror, T all of its delays: (w T)^2 / 2 of the series, and what filter and resonance add."""
    made = scene("plays")
    loop = quiet(made.loop)
    straight = replace(loop, mirror=linearised(loop.mirror, [rest_gain(model) for model in loop.mirror.bank]))
    late, of_rate = measured_delays(quiet(made.rest))
    for freq in (15.0, 25.0):
        one = tuple(Reference(0.0, 0.0, 1.0, 300 * URAD, freq) for _ in "xy")
        followed = replace(straight, references=one)
        left = rms(followed, with_feedforward("ahead", followed, idle(followed), PATH)) * math.sqrt(2) / (300 * URAD)
        turn = 2 * math.pi * freq * np.diag(late) * of_rate
        assert np.all((0.4 * turn**2 < left) & (left < 0.8 * turn**2))


# ------------------------------------------------------------------------------------------- the model run ahead of it
@pytest.mark.promise("pointing-88")
@each_family
def test_the_models_own_loop_run_ahead_leaves_what_feedback_alone_leaves(family):
    """Its drive as feedforward and its output as reference, C e_m + C (e - e_m) = C e: whether it is right or wrong."""
    found = scene(family)
    loop, feedback = quiet(found.loop), integral(found)
    model = traces.replay(loop, feedback, 2501, 1)
    for errors in ({}, {"gain": 0.8, "width": 1.3, "resonance": 1.05}):
        real = replace(loop, mirror=with_errors(loop.mirror, **errors))
        ran, given = driven(real, feedback, model.commands, model.error_rad)
        repeated = traces.replay(ran, given, 2500, 1).error_rad[:, :2]
        alone = traces.replay(real, feedback, 2500, 1).error_rad
        assert_allclose(repeated, alone, rtol=0, atol=1e-9 * np.abs(alone).max())
    assert RAD_V * np.abs(model.commands).max() < 1e-6


@pytest.mark.promise("pointing-90")
@each_family
def test_errors_of_the_model_cost_their_share(family):
    """With a gain 20 % too large it leaves what the missing fifth does; a resonance off by 5 % costs nothing."""
    found = scene(family)
    controller = forward(found)
    right = rms(quiet(found.loop), controller)

    def on(**wrong):
        return rms(quiet(replace(found.loop, mirror=with_errors(found.loop.mirror, **wrong))), controller)

    alone = rms(quiet(found.loop), integral(found))
    weak = on(gain=0.8)
    print(family, right / URAD, weak / URAD, alone / URAD)
    assert np.all((0.15 * alone < weak) & (weak < 0.3 * alone))
    assert np.all(on(width=1.3) < 0.05 * alone)
    for share in (0.95, 1.05):
        assert_allclose(on(resonance=share), right, rtol=0.05)


# -------------------------------------------------------------------------------------------- theory, designs, refusals
@pytest.mark.promise("pointing-84")
def test_feedback_and_its_theory_are_left_as_they_are():
    found = scene("plays")
    feedback = integral(found)
    plain, ahead = (linear.stationary(linear.close(found.rest, c)) for c in (feedback, forward(found, feedback)))
    assert_allclose(ahead.error, plain.error, rtol=1e-9)


def test_the_elements_of_a_feedforward_count_in_theory_by_their_slow_gains():
    found = scene("plays")
    controller = forward(found)
    slow = controller.forward.drives * sum(found.loop.mirror.plays[0].weights_rad_v)
    straight = linear.straightened(controller, found.loop).system
    for key in "CD":
        v, q = np.split(getattr(controller.system, key), 2)
        assert_allclose(getattr(straight, key), v + slow @ q, rtol=1e-12)
        assert np.abs(slow @ q).max() > 0.1 * np.abs(v[:, -2:]).max()


@pytest.mark.promise("choose-7")
@pytest.mark.promise("pointing-78")
def test_it_is_designed_where_a_reference_is_known_and_has_the_margins_of_its_feedback():
    made = scene("Bouc-Wen")
    assert coupled_study.names(made.table)[:3] == ("PI", "PI + feedforward", "PI + notch")
    still = mission(
        ("point_ahead_on_mirror = true", "point_ahead_on_mirror = false"),
        ("rate_feedforward = 0.99", "rate_feedforward = 1.0"),
    )
    assert "PI + feedforward" not in coupled_study.names(still.mission.fine_pointing)
    plain, ahead = coupled_study.design(made, only=("PI", "PI + feedforward")).made
    assert (ahead.name, ahead.controller.name) == ("PI + feedforward",) * 2
    assert (ahead.tuned, ahead.margins) == (plain.tuned, plain.margins)
    assert plain.controller.forward is None
    assert ahead.controller.forward.bank == made.loop.mirror.bank
    left = [rms(made.loop, d.controller) for d in (plain, ahead)]
    assert np.all(left[1] < 0.05 * left[0])
    (alone,) = coupled_study.design(made, only=("PI + feedforward",)).made
    assert_allclose(alone.controller.system.C, ahead.controller.system.C, rtol=1e-12)


REFUSED = {
    "already": (lambda found: (found.loop, forward(found)), "has an inverse or a feedforward of the reference already"),
    "with an inverse": (
        lambda found: (found.loop, replace(integral(found), inverse=forward(found).forward)),
        "has an inverse or a feedforward of the reference already",
    ),
    "ahead of the linear part": (
        lambda found: (
            replace(
                found.loop, mirror=replace(found.loop.mirror, inverse=(PrandtlIshlinskii((0.0,), (20 * URAD,)),) * 2)
            ),
            integral(found),
        ),
        "lies ahead of its linear part, where it has an inverse; use with_inverse",
    ),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_it_does_not_fit_is_refused(name):
    make, told = REFUSED[name]
    loop, feedback = make(scene("plays"))
    with pytest.raises(ValueError, match=told):
        with_feedforward("ahead", loop, feedback, PATH)


@pytest.mark.promise("pointing-90")
def test_a_controller_without_an_output_for_each_element_is_refused():
    found = scene("plays")
    controller = forward(found)
    s = controller.system
    short = replace(controller, system=lti.StateSpace(s.A, s.B, s.C[:-1], s.D[:-1]))
    with pytest.raises(ValueError, match=r"matrix C has the shape \(3, 6\), the loop needs \(4, 6\)"):
        arrays(found.loop, short, 1)


@pytest.mark.promise("choose-7")
@pytest.mark.promise("export-27")
def test_an_inverse_is_refused_with_what_to_take_instead():
    found = scene("plays")
    axis = AxisController("I", lti.StateSpace(np.eye(1), np.eye(1, 2), np.eye(1), np.eye(1, 2)), np.eye(1))
    with pytest.raises(ValueError, match="not ahead of it; use with_feedforward, which runs it forward"):
        with_inverse("PI + inverse", found.loop, axis, control.inverse(found.loop.mirror), PATH, False)


@pytest.mark.parametrize("name", ["already", "ahead of the linear part"])
def test_a_refused_feedforward_is_told_with_its_own_name_the_feedbacks_and_the_mirrors(name):
    loop, feedback = REFUSED[name][0](scene("plays"))
    loop = replace(loop, mirror=replace(loop.mirror, name="a plate"))
    with pytest.raises(ValueError) as refused:
        with_feedforward("ahead", loop, replace(feedback, name="behind"), PATH)
    assert (
        str(refused.value)
        == {
            "already": "controller 'ahead': 'behind' has an inverse or a feedforward of the reference already, and "
            "two would "
            "drive the mirror twice as far; give the feedback alone",
            "ahead of the linear part": "controller 'ahead': the hysteresis of mirror 'a plate' lies ahead of its "
            "linear "
            "part, where it has an inverse; use with_inverse",
        }[name]
    )


def test_a_loop_takes_targets_of_an_inverse_and_none_where_hysteresis_is_run_ahead():
    given = scene(next(iter(FAMILIES)))
    ahead, alone = (arrays(given.loop, each, 1) for each in (forward(given), integral(given)))
    assert (ahead.feedforward, alone.feedforward) == (False, False)
    assert (ahead.forward.drives.shape[1], alone.forward.drives.shape[1]) == (len(given.loop.mirror.bank), 0)
    plays = loop_of()
    assert arrays(plays, in_series(plays), 1).feedforward
