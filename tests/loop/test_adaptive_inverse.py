"""A pointing loop whose inverse learns: what is expected of a reading, what is refused, and what it brings."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from learning_loops import CREEP, PLAYS, in_series, loop_of, resonance, softened
from microrad.core import kernels, lti
from microrad.loop import control, controller_study
from microrad.loop.pointing_loop import ensemble
from microrad.loop.pointing_loop import loop as fine
from microrad.mirror.hysteresis import NO_CREEP, BoucWen


@pytest.mark.parametrize("system", [None, resonance(1200.0, 0.02), resonance(300.0, 0.1)])
def test_the_reading_that_is_expected_is_the_loops_own_in_low_order(system):
    loop = loop_of(system=system)
    freq = np.array([0.01, 1.0, 10.0, 100.0, 400.0, 1000.0])
    expected = fine.expected_reading(loop, 0)
    whole = control.sampled_plant(loop.mirror, loop.drive, loop.timing)
    exact = lti.frequency_response(whole, freq, 2e-4)[:, 0, 0] / sum(PLAYS.weights_rad_v)
    found = lti.frequency_response(expected, freq, 2e-4)[:, 0, 0]
    assert 0.0 < np.max(np.abs(found - exact)) < fine.EXPECTED_WITHIN
    assert_allclose(found[0], exact[0], atol=1e-6)  # the slow gain is exact, but for rounding to 32 bits and 0.01 Hz
    assert expected.order < whole.order


def test_creep_belongs_to_the_inverse_and_not_to_the_reading_that_a_target_makes_expect():
    without, with_it = (fine.expected_reading(loop_of(creep=creep), 0) for creep in (NO_CREEP, CREEP))
    freq = np.array([0.1, 10.0, 200.0])
    responses = [lti.frequency_response(each, freq, 2e-4) for each in (without, with_it)]
    assert_allclose(*responses, rtol=1e-8)


def test_on_the_mirror_that_it_was_designed_for_it_is_the_frozen_inverse():
    loop, span = loop_of(), ensemble.Span(0.3, 0.1, 3)
    frozen = in_series(loop)
    runs = ensemble.simulate_cases(
        [ensemble.Case(loop, frozen), ensemble.Case(loop, fine.with_adaptation(frozen, loop))], span, 64
    )
    assert_allclose(runs[0].rms_rad, runs[1].rms_rad, rtol=1e-9)
    assert np.all(runs[1].counts[:, kernels.COUNT_FALLBACK] == 0.0)


def test_on_a_softened_mirror_it_leaves_less_than_the_frozen_inverse():
    nominal = loop_of(axes=2)
    frozen, span = in_series(nominal), ensemble.Span(1.5, 0.75, 3)
    softer = replace(loop_of(softened(PLAYS), CREEP, axes=2), disturbances=nominal.disturbances)
    cases = [ensemble.Case(softer, each) for each in (frozen, fine.with_adaptation(frozen, nominal))]
    left, learnt = (run.radial_rms_rad for run in ensemble.simulate_cases(cases, span, 64))
    straight = ensemble.simulate(nominal, frozen, span, 64).radial_rms_rad
    assert straight < learnt < left
    assert learnt - straight < 0.5 * (left - straight)


@pytest.mark.parametrize(
    ("loop", "words"),
    [
        (replace(loop_of(), gauge=None), "learns from a strain gauge, and this loop has none"),
        (loop_of(replace(PLAYS, widening_s=1e-4, rate_limit_v_s=3e3)), "widen with the drive's rate"),
        (loop_of(replace(PLAYS, weights_rad_v=(50e-6, 10e-6, -1e-6, 10e-6, 9e-6))), "one of this mirror is -1e-06"),
        (loop_of(BoucWen(89e-6, 0.0, -22e-6, 0.0, 2.4, 0.6)), "hysteresis is a Bouc-Wen model"),
    ],
)
def test_what_cannot_learn_is_refused_with_what_to_do(loop, words):
    with pytest.raises(ValueError, match=words) as refused:
        fine.with_adaptation(in_series(loop), loop)
    assert "take the frozen inverse" in str(refused.value)


def test_a_model_that_is_to_be_reduced_keeps_its_slow_gain_and_the_bound_that_is_asked_for():
    rng = np.random.default_rng(5)
    A = np.diag(rng.uniform(-0.6, 0.95, 9))
    system = lti.StateSpace(A, rng.standard_normal((9, 1)), rng.standard_normal((1, 9)), np.ones((1, 1)))
    freq = np.linspace(0.0, 0.5, 200)
    exact = lti.frequency_response(system, freq, 1.0)[:, 0, 0]
    orders = []
    for error in (1e-9, 1e-3, 0.3):
        found = lti.reduced(system, error)
        response = lti.frequency_response(found, freq, 1.0)[:, 0, 0]
        assert np.max(np.abs(response - exact)) <= error + 1e-10
        assert_allclose(response[0], exact[0], rtol=1e-9)
        orders.append(found.order)
    assert 9 >= orders[0] > orders[1] > orders[2]


def test_it_is_offered_where_a_mirror_has_plays_and_a_mission_a_gauge():
    import shipped
    from microrad.mission.file import load_mission

    mission = load_mission(shipped.SHIPPED).mission
    table, of = mission.fine_pointing, mission.mirror
    assert controller_study.offered(table, of) == controller_study.names(table)  # Bouc-Wen
    plays = of.model_copy(update={"prandtl_ishlinskii": object(), "bouc_wen": None})
    assert controller_study.offered(table, plays)[-1] == "PI + adaptive inverse in series"
    blind = table.model_copy(update={"strain_gauge": None})
    assert controller_study.offered(blind, plays) == controller_study.names(blind)
