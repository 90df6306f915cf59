"""Tuning against brute force over exact variances and margins, and what it says when it cannot."""

import math
import os
from dataclasses import replace
from functools import cache, partial
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.optimize import minimize_scalar

from design_plants import axis_plant
from microrad.core import lti
from microrad.loop.control import analysis, classical, descent, judge, lqg, search, tuning
from microrad.loop.control.lqg import LQG
from microrad.loop.control.problem import RESIDUAL, AxisController, Family, Parameter, Specification
from microrad.loop.controller_study import designs, promises
from microrad.mission.file import load_mission
from scenes import scene_of
from shipped import SHIPPED

PERIOD = 2e-4
HALF = Specification(modulus_margin=0.5)
ANY = Specification(modulus_margin=1e-3)
near = partial(pytest.approx, abs=0.0, rel=1e-6)

PLAIN = axis_plant(gauge=False)
QUIET = axis_plant(gauge=False, noise_rad=0.1e-6)
NOISY = axis_plant(gauge=False, noise_rad=20e-6)
RESONANT = axis_plant(resonance=(900.0, 0.02), lines=((87.0, 2e-6),))


def pi(plant, values):
    """Integral and proportional gain, both times the slow gain of the mirror: rad/s and 1."""
    step, proportional = values[0] * PERIOD / plant.gain_rad_v, values[1] / plant.gain_rad_v
    s = lti.StateSpace(
        np.ones((1, 1)), np.array([[step, 0.0]]), np.ones((1, 1)), np.array([[step + proportional, 0.0]])
    )
    return AxisController("PI", s, np.zeros((1, 1)))


def family(most=5e3, least=1.0):
    integral = Parameter("integral", "rad/s", least, most)
    return Family("PI", lambda plant: (integral, Parameter("proportional", "", 1e-4, 3.0)), pi)


PI = family()
INTEGRAL = Family(
    "integral", lambda plant: (Parameter("integral", "rad/s", 1.0, 5e3),), lambda plant, v: pi(plant, [v[0], 0.0])
)


def rms(plant, controller):
    return math.sqrt(analysis.h2(analysis.close(plant, controller))[RESIDUAL].sum())


def modulus(plant, controller):
    """By plain evaluation on a dense grid, without the margins' own refinement."""
    freq_hz = np.concatenate([np.geomspace(0.1, 50, 100), np.linspace(50, 2500, 8000)])
    return np.min(np.abs(1 + analysis.loop_response(plant, controller, freq_hz)))


def stable(plant, controller):
    return abs(analysis.loop_poles(plant, controller)[0]) < 1.0


# ------------------------------------------------------------------------------------------------ the judge


def dual(plant, values):
    """PI with a high-passed gauge that damps."""
    plain, k = pi(plant, values).system, 0.3 / plant.gain_rad_v
    return AxisController(
        "dual",
        lti.StateSpace(
            np.diag([1.0, 0.6]),
            np.array([[plain.B[0, 0], 0.0], [0.0, 0.4]]),
            np.array([[1.0, -k]]),
            np.array([[plain.D[0, 0], k]]),
        ),
        np.zeros((2, 1)),
    )


CASES = {
    "PI": (PLAIN, pi(PLAIN, [400.0, 0.1])),
    "slow body": (axis_plant(corner_hz=0.01, disturbance_rad=1e-4), pi(PLAIN, [300.0, 0.01])),
    "resonance and line": (RESONANT, pi(RESONANT, [300.0, 0.0])),
    "sharp resonance": (axis_plant(resonance=(700.0, 0.003)), pi(PLAIN, [20.0, 0.0])),
    "two sensors": (RESONANT, dual(RESONANT, [500.0, 0.1])),
    "LQG": (RESONANT, lqg.lqg_controller(RESONANT, lqg.Weights(1e-3, 1.0, 1e-3))),
}


@pytest.mark.parametrize("name", CASES)
def test_the_judge_agrees_with_variance_and_margins_within_a_per_cent(name):
    plant, controller = CASES[name]
    found = judge.Judge([plant])(controller)
    margins = analysis.loop_margins(plant, controller)
    assert found.mean_rad2 == near(rms(plant, controller) ** 2, rel=0.01)
    assert np.min(found.moduli) == near(margins.modulus, rel=1e-3)
    assert found.bandwidths_hz[0] == near(margins.bandwidth_hz, rel=0.01)
    assert found.pole == near(abs(analysis.loop_poles(plant, controller)[0]), rel=1e-9)


@pytest.mark.parametrize("plant", [PLAIN, RESONANT, CASES["slow body"][0]])
def test_the_judge_knows_the_residual_without_a_loop(plant):
    silent = AxisController(
        "none",
        lti.StateSpace(np.zeros((0, 0)), np.zeros((0, 2)), np.zeros((1, 0)), np.zeros((1, 2))),
        np.zeros((0, 1)),
    )
    assert judge.Judge([plant]).open_rad2 == near(rms(plant, silent) ** 2, rel=0.01)


def test_many_controllers_are_judged_as_each_alone():
    """Of several orders, with one sensor and with both, and an unstable one among them."""
    of = judge.Judge([axis_plant(gain=0.089e-3 * g, resonance=(900.0, 0.3)) for g in (1.0, 0.8)])
    several = [
        *(pi(RESONANT, [gain, 0.1]) for gain in (50.0, 300.0, 5e4)),
        dual(RESONANT, [500.0, 0.1]),
        CASES["LQG"][1],
        pi(RESONANT, [100.0, 0.0]),
    ]
    for together, controller in zip(of.several(several), several, strict=True):
        alone = of(controller)
        assert together.pole == near(alone.pole, rel=1e-12)
        assert together.mean_rad2 == near(alone.mean_rad2, rel=1e-12)
        np.testing.assert_allclose(together.moduli, alone.moduli, rtol=1e-12)
        np.testing.assert_allclose(together.bandwidths_hz, alone.bandwidths_hz, rtol=1e-12)
    found = of.several(several)
    assert found[2].pole > 1.0 and found[2].mean_rad2 == math.inf
    assert len({v.mean_rad2 for v in found}) == len(found)


@pytest.mark.promise("pointing-11", "sampled-loop-12")
def test_the_judge_means_variances_and_takes_the_worst_margins_of_all_plants():
    plants = [PLAIN, axis_plant(gauge=False, gain=0.11e-3, resonance=(1200.0, 0.1))]
    controller = pi(PLAIN, [400.0, 0.1])
    both, alone = judge.Judge(plants)(controller), [judge.Judge([p])(controller) for p in plants]
    assert both.mean_rad2 == near(np.mean([a.mean_rad2 for a in alone]))
    assert np.min(both.moduli) == near(min(np.min(a.moduli) for a in alone), rel=1e-12)
    assert np.min(alone[0].moduli) > 1.1 * np.min(alone[1].moduli)
    assert list(both.bandwidths_hz) == [a.bandwidths_hz[0] for a in alone]


def test_the_judge_calls_an_unstable_plant_of_several_unstable():
    plants = [PLAIN, axis_plant(gauge=False, gain=0.3e-3)]
    controller = pi(PLAIN, [1200.0, 0.5])
    assert stable(plants[0], controller)
    assert judge.Judge(plants)(controller).pole == near(abs(analysis.loop_poles(plants[1], controller)[0]))
    assert judge.Judge(plants)(controller).pole > 1.0
    assert judge.Judge(plants)(controller).mean_rad2 == math.inf
    assert np.all(judge.Judge(plants)(controller).moduli == 0.0)


def test_responses_of_controllers_whose_modes_coincide():
    A = np.array([[0.5, 1.0, 0.0], [0.0, 0.5, 1.0], [0.0, 0.0, 0.5]])
    s = lti.StateSpace(A, np.eye(3, 2), np.array([[1.0, -2.0, 3.0]]), np.array([[0.3, -0.1]]))
    freq_hz = np.array([1.0, 100.0, 2400.0])
    expected = lti.frequency_response(s, freq_hz, PERIOD)[:, 0, :]
    found = judge.response(s, np.exp(2j * np.pi * freq_hz * PERIOD))
    np.testing.assert_allclose(found, expected, rtol=1e-12)


# ------------------------------------------------------------------------------------------------ the optimum


def test_the_free_optimum_of_one_gain_is_that_of_a_scalar_minimiser():
    exact = minimize_scalar(
        lambda x: rms(NOISY, pi(NOISY, [math.exp(x), 0.0])), bounds=(math.log(5), math.log(500)), method="bounded"
    )
    found = tuning.tune(INTEGRAL, [NOISY], ANY, seed=1)
    assert found.residual_rms_rad == near(exact.fun, rel=1e-4)
    assert found.values["integral"] == near(math.exp(exact.x), rel=0.02)
    assert found.bound_by == ()


@pytest.mark.promise("pointing-11", "sampled-loop-12")
def test_a_tuned_pi_is_the_best_of_a_fine_grid_with_exact_variances_and_margins():
    best = (math.inf, None)
    for integral in np.geomspace(100.0, 2e3, 24):
        for proportional in [1e-4, *np.geomspace(0.01, 1.0, 16)]:
            controller = pi(PLAIN, [integral, proportional])
            if stable(PLAIN, controller):
                left = rms(PLAIN, controller)
                if left < best[0] and modulus(PLAIN, controller) >= 0.5:
                    best = (left, (integral, proportional))
    found = tuning.tune(PI, [PLAIN], HALF, seed=1)
    print(f"grid {1e6 * best[0]:.4f} urad at {best[1]}, tuned {1e6 * found.residual_rms_rad:.4f} at {found.values}")
    assert 0.98 * best[0] < found.residual_rms_rad < 1.002 * best[0]


@pytest.mark.promise("pointing-12")
@pytest.mark.parametrize("plant", [QUIET, RESONANT], ids=["quiet", "resonant"])
def test_the_margin_is_respected_and_named_where_it_binds(plant):
    found = tuning.tune(PI, [plant], Specification(0.7), seed=1)
    assert 0.7 <= found.least_modulus < 0.7 * 1.0015  # a thousandth more is aimed at, and values are rounded
    assert modulus(plant, found.controller) == near(found.least_modulus, rel=1e-3)
    assert found.margins == analysis.loop_margins(plant, found.controller)
    assert tuning.MARGIN in found.bound_by
    assert found.residual_rms_rad == near(rms(plant, found.controller))
    freer = tuning.tune(PI, [plant], HALF, seed=1)
    assert freer.residual_rms_rad < 0.98 * found.residual_rms_rad


@pytest.mark.promise("sampled-loop-10")
def test_a_narrow_dip_beside_the_grid_does_not_cost_the_margin():
    sharp = axis_plant(resonance=(700.0, 0.003), gauge=False)
    found = tuning.tune(INTEGRAL, [sharp], HALF, seed=2)
    assert 0.5 <= found.least_modulus < 0.502
    freq_hz = np.linspace(690.0, 710.0, 20001)
    assert np.min(np.abs(1 + analysis.loop_response(sharp, found.controller, freq_hz))) >= 0.5


def test_a_search_whose_grid_overstates_the_margin_goes_on_with_a_stricter_one(monkeypatch):
    fine = tuning.tune(PI, [RESONANT], HALF, seed=2)
    dips = judge.Judge._dips
    monkeypatch.setattr(judge.Judge, "_dips", lambda *args: [1.04 * d for d in dips(*args)])
    assert np.min(judge.Judge([RESONANT])(fine.controller).moduli) > 1.03 * fine.least_modulus
    found = tuning.tune(PI, [RESONANT], HALF, seed=2)
    assert 0.5 <= found.least_modulus < 0.505
    assert found.residual_rms_rad == near(fine.residual_rms_rad, rel=0.005)


def test_a_bandwidth_that_is_asked_for_is_reached_at_a_price():
    free = tuning.tune(PI, [NOISY], HALF, seed=1)
    asked = 3.0 * free.margins.bandwidth_hz
    found = tuning.tune(PI, [NOISY], Specification(0.5, bandwidth_hz=asked), seed=1)
    assert asked <= found.least_bandwidth_hz < 1.01 * asked
    assert found.bound_by[0] == tuning.BANDWIDTH
    assert found.residual_rms_rad > 1.01 * free.residual_rms_rad
    assert tuning.BANDWIDTH not in free.bound_by


def test_a_bound_is_named_where_it_costs():
    narrow = Family("PI", lambda plant: (Parameter("integral", "rad/s", 1.0, 100.0),), INTEGRAL.build)
    found = tuning.tune(narrow, [PLAIN], HALF, seed=1)
    assert found.values["integral"] == near(100.0, rel=1e-3)
    assert "integral at its most" in found.bound_by
    assert tuning.MARGIN not in found.bound_by
    high = tuning.tune(family(least=1e3), [NOISY], HALF, seed=1)
    assert "integral at its least" in high.bound_by


def test_a_bound_that_costs_nothing_is_not_named():
    idle = Parameter("idle", "", 1.0, 2.0)
    both = Family("PI", lambda plant: (*PI.parameters(plant), idle), lambda plant, v: pi(plant, v[:2]))
    found = tuning.grid_best(both, [NOISY], ANY, [[30.0, 50.0, 90.0], [0.01], [1.0]])
    assert found.bound_by == ()


FLAT = {
    "PI": (PI, PLAIN),
    "PI + notch": (classical.PI_NOTCH, RESONANT),
    "resonant damping": (classical.RESONANT_DAMPING, RESONANT),
    "disturbance observer": (classical.DISTURBANCE_OBSERVER, PLAIN),
    "LQG": (LQG, RESONANT),
}
REPEATED = {"PI + notch", "resonant damping"}
"""Their optima have tests of their own below."""


@cache
def tuned(name):
    """What a family is tuned to, and each place where a search for it has ended."""
    of, plant = FLAT[name]
    kept, settle = [], tuning.settle
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(tuning, "settle", lambda *args: kept.append((args[0], settle(*args))) or kept[-1][1])
        return tuning.tune(of, [plant], HALF, seed=1), kept


def test_lqg_beats_the_tuned_pi_under_the_same_margin():
    ours, theirs = tuned("LQG")[0], tuning.tune(PI, [RESONANT], HALF, seed=1)
    print(f"LQG {1e6 * ours.residual_rms_rad:.3f} urad, PI {1e6 * theirs.residual_rms_rad:.3f} urad")
    assert ours.residual_rms_rad < 0.8 * theirs.residual_rms_rad
    assert ours.least_modulus >= 0.5


# ------------------------------------------------------------------------------------------------ the search


@pytest.mark.promise("pointing-12", "pointing-13")
@pytest.mark.parametrize(
    "plant", [RESONANT, pytest.param(NOISY, marks=pytest.mark.endurance)], ids=["at the margin", "within it"]
)
def test_each_seed_ends_at_the_same_four_digits(plant):
    found = [tuning.tune(PI, [plant], HALF, seed=s) for s in (7, 7, 8, 9)]
    assert found[0].evaluations == found[1].evaluations != found[2].evaluations
    assert all(f.values == found[0].values for f in found)
    assert all(v == float(f"{v:.3e}") for v in found[0].values.values())


@pytest.mark.promise("pointing-12", "sampled-loop-12")
@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[pytest.mark.endurance] if name in REPEATED else []) for name in FLAT]
)
def test_nothing_beside_a_tuned_controller_is_better(name):
    of, best = min(tuned(name)[1], key=lambda each: each[1].score)
    rng = np.random.default_rng(1)
    for size in (1e-5, 1e-4, 1e-3):
        for _ in range(20):
            there = of.at(best.place + size * rng.standard_normal(best.place.size))
            if there.violation <= best.violation + 1e-9:
                assert there.cost > best.cost - 1e-9
    assert best.violation < 1e-8


@pytest.mark.promise("pointing-12")
def test_a_place_is_the_same_wherever_the_last_search_sets_out(monkeypatch):
    of = search.Search(LQG, [RESONANT], HALF)
    starts = (of.at(np.array([0.3, 0.5, 0.3])), of.at(np.array([0.25, 0.45, 0.5])))
    places = [descent.settle(of, descent.descend(of, start)).place for start in starts]
    assert np.max(np.abs(places[0] - places[1])) < 1e-7  # over the bounds: 1e-6 of a value that spans six decades


@pytest.mark.promise("pointing-12")
def test_where_the_residual_does_not_tell_the_gentler_value_is_taken():
    idle = Parameter("idle", "", 1.0, 2.0, gentle=1.7)
    both = Family("PI", lambda plant: (*PI.parameters(plant), idle), lambda plant, v: pi(plant, v[:2]))
    found = tuning.tune(both, [NOISY], HALF, seed=1)
    assert found.values["idle"] == 1.7
    alone = tuning.tune(PI, [NOISY], HALF, seed=1)
    assert found.values == {**alone.values, "idle": 1.7}


@pytest.mark.promise("pointing-12")
@pytest.mark.parametrize(
    "plants",
    [
        pytest.param(
            [axis_plant(gain=0.089e-3 * g, resonance=(900.0, 0.3)) for g in (1.0, 0.8)], marks=pytest.mark.endurance
        ),
        pytest.param([NOISY], marks=pytest.mark.endurance),
    ],
    ids=["two plants", "one"],
)
def test_a_family_that_contains_another_is_never_worse(plants):
    known = tuning.tune(classical.PI, plants, HALF, seed=1)
    assert tuning.tune(classical.PI_NOTCH, plants, HALF, seed=1, base=known).mean_rms_rad <= known.mean_rms_rad


@pytest.mark.promise("pointing-12")
def test_a_search_that_ends_somewhere_leaves_the_contained_controller(monkeypatch):
    known = tuning.tune(classical.PI, [NOISY], HALF, seed=1)
    monkeypatch.setattr(tuning, "settle", lambda of, t, models: of.at(np.full(5, 0.4)))
    found = tuning.tune(classical.PI_NOTCH, [NOISY], HALF, seed=1, base=known)
    assert found.values["notch depth"] == 1.0


def test_the_notch_is_sought_beside_the_pi_and_far_from_it():
    """The best is a wide notch beside the tuned PI on the one plant, far from it on the other; LQG is the floor."""
    if os.environ.get("MICRORAD_ENDURANCE"):
        shipped = load_mission(SHIPPED)
        seed = shipped.mission.fine_pointing.seed
        paper = designs.plants(scene_of(shipped), seed)
        wanted = Specification(shipped.mission.fine_pointing.modulus_margin)
        assert 1.0715e-6 < tuning.tune(classical.PI_NOTCH, paper, wanted, seed=seed).mean_rms_rad < 1.0730e-6
    assert 1.0259e-6 < tuning.tune(classical.PI_NOTCH, [PLAIN], HALF, seed=1).mean_rms_rad < 1.0269e-6


@pytest.mark.promise("pointing-12")
@pytest.mark.parametrize("node", [1e-3, 0.02, 0.2])
@pytest.mark.parametrize("x", [0.0, 1e-4, 0.03, 0.5, 0.99, 1.0])
def test_the_points_of_a_slope_lie_within_the_bounds(x, node):
    points = x + node * descent._offsets(x, node)
    np.testing.assert_allclose(np.diff(points), node, rtol=1e-9)
    assert points[0] >= -1e-12 and points[-1] <= 1.0 + 1e-12
    assert points[0] - 1e-12 <= x <= points[-1] + 1e-12
    if 2.0 * node <= x <= 1.0 - 2.0 * node:
        assert points[2] == pytest.approx(x, abs=1e-12)


@pytest.mark.endurance
def test_an_optimum_beside_a_kink_is_the_same_from_every_start():
    """On this mirror the margin's constraint passes from one dip of |1 + L| to another beside the optimum."""
    soft = load_mission(SHIPPED, Path("docs/gallery/long-stroke.toml"))
    mirror = designs.plants(scene_of(soft), soft.mission.fine_pointing.seed)
    first, second = (tuning.tune(classical.RESONANT_DAMPING, mirror, HALF, seed=seed) for seed in (2, 3))
    assert first.values == second.values
    assert (first.mean_rms_rad, first.least_modulus) == (second.mean_rms_rad, second.least_modulus)


@pytest.mark.promise("pointing-12")
def test_a_search_begins_at_a_hypercube_half_of_it_beside_what_it_contains(monkeypatch):
    class LookedError(Exception):
        """Ends the search behind its first look."""

    def first(family, seed, base=None):
        with pytest.raises(LookedError) as looked:
            tuning.tune(family, [NOISY], HALF, seed=seed, base=base)
        return np.array(looked.value.args[0])

    known = tuning.grid_best(classical.PI, [NOISY], HALF, [[2 * math.pi * 20.0], [2 * math.pi * 900.0]])

    def look(of, places):
        raise LookedError(places)

    monkeypatch.setattr(search.Search, "at_all", look)
    alone = first(classical.PI, 1)
    assert alone.shape == (100, 2)
    assert np.array_equal(np.sort(np.floor(100 * alone), axis=0), np.repeat(np.arange(100.0)[:, None], 2, axis=1))
    assert np.array_equal(alone, first(classical.PI, 1)) and not np.array_equal(alone, first(classical.PI, 2))
    beside = first(classical.PI_NOTCH, 1, known)
    assert np.ptp(beside[::2, :2], axis=0).tolist() == [0.0, 0.0]
    assert np.min(np.ptp(beside[1::2], axis=0)) > 0.9


@pytest.mark.promise("pointing-12")
def test_local_searches_set_out_from_eight_places_at_most_or_until_three_agree(monkeypatch):
    begun, costs = [], iter(range(100))
    descend, settle = tuning.descend, tuning.settle
    monkeypatch.setattr(tuning, "descend", lambda *args: begun.append(1) or descend(*args))
    tuning.tune(PI, [NOISY], HALF, seed=1)
    assert len(begun) == 3  # of one optimum
    begun.clear()

    def elsewhere(of, start):
        """Each search as if it ended somewhere of its own, better than the last."""
        begun.append(1)
        return replace(start, cost=start.cost - next(costs))

    monkeypatch.setattr(tuning, "descend", elsewhere)
    monkeypatch.setattr(tuning, "settle", lambda of, trial, models: settle(of, of.at(trial.place), models))
    tuning.tune(PI, [NOISY], HALF, seed=1)
    assert len(begun) == 8


def test_progress_is_reported_up_to_its_total():
    told = []
    tuning.tune(PI, [PLAIN], HALF, seed=1, on_progress=lambda *args: told.append(args))
    done = [t[0] for t in told]
    assert done[0] == tuning.SURVEY
    assert done == sorted(done)
    total = tuning.SURVEY + tuning.STARTS + tuning.FINALISTS
    assert done[-1] == total
    assert {t[1:] for t in told} == {(total, "tune PI")}


@pytest.mark.promise("pointing-11", "sampled-loop-12")
def test_robust_tuning_keeps_the_margin_where_nominal_tuning_loses_it():
    plants = [axis_plant(gauge=False, gain=0.089e-3 * g, noise_rad=0.1e-6) for g in (1.0, 0.8, 1.2)]
    nominal = tuning.tune(PI, plants[:1], HALF, seed=1)
    robust = tuning.tune(PI, plants, HALF, seed=1)
    assert min(modulus(p, nominal.controller) for p in plants) < 0.45
    least = min(modulus(p, robust.controller) for p in plants)
    assert 0.4999 <= least < 0.505
    assert robust.least_modulus == near(least, rel=1e-3)
    assert robust.margins.modulus > 1.05 * least
    each = [rms(p, robust.controller) for p in plants]
    assert robust.residual_rms_rad == near(each[0])
    assert robust.worst_rms_rad == near(max(each))
    assert robust.mean_rms_rad == near(math.sqrt(np.mean(np.square(each))))
    assert robust.residual_rms_rad > nominal.residual_rms_rad


@pytest.mark.promise("pointing-16")
def test_the_best_of_a_grid_is_one_of_its_points():
    grid = ([200.0, 400.0, 800.0, 1600.0, 3200.0], [1e-4, 0.1, 0.4])
    found = tuning.grid_best(PI, [PLAIN], HALF, grid)
    best = (math.inf, None)
    for i in grid[0]:
        for p in grid[1]:
            c = pi(PLAIN, [i, p])
            if stable(PLAIN, c) and modulus(PLAIN, c) >= 0.5:
                best = min(best, (rms(PLAIN, c), (i, p)))
    assert tuple(found.values.values()) == best[1]
    assert found.residual_rms_rad == near(best[0])
    assert found.evaluations == 15


def test_the_best_of_a_grid_is_looked_at_closely(monkeypatch):
    grid = [list(np.geomspace(200.0, 2000.0, 40))]
    honest = tuning.grid_best(INTEGRAL, [RESONANT], HALF, grid)
    assert 0.5 <= honest.least_modulus < 0.53
    dips = judge.Judge._dips
    monkeypatch.setattr(judge.Judge, "_dips", lambda *args: [1.2 * d for d in dips(*args)])
    assert tuning.grid_best(INTEGRAL, [RESONANT], HALF, grid).values == honest.values


def test_a_family_without_parameters_is_judged_as_it_is():
    fixed = Family("fixed", lambda plant: (), lambda plant, v: pi(plant, [400.0, 0.1]))
    found = tuning.tune(fixed, [PLAIN], HALF, seed=1)
    assert found.residual_rms_rad == near(rms(PLAIN, pi(PLAIN, [400.0, 0.1])))
    assert found.values == {}


# ------------------------------------------------------------------------------------------------ refusals


def test_a_family_without_a_stable_member_is_refused():
    with pytest.raises(ValueError, match=r"no PI of \d+ tried is stable: the nearest has a pole at \|z\| = ") as read:
        tuning.tune(family(least=4e3, most=9e3), [axis_plant(gauge=False, delay=4)], HALF, seed=1)
    assert "(the limit is 1) with integral 4000 rad/s, proportional" in str(read.value)
    assert str(read.value).endswith(
        "shorten the delay, narrow what is unknown of the plant, or take another controller"
    )


@pytest.mark.promise("pointing-31")
def test_a_specification_out_of_reach_is_refused_with_what_was_reached():
    asked = Specification(0.9, bandwidth_hz=900.0)
    with pytest.raises(
        ValueError,
        match=r"on all 2 plants: a modulus margin of 0\.9 and a bandwidth of 900 Hz is asked for",
    ) as read:
        tuning.tune(PI, [PLAIN, QUIET], asked, seed=1)
    reached = str(read.value).split("the nearest reaches ")[1].split(" Hz")[0].split(" and ")
    margin, bandwidth = (float(r) for r in reached)
    assert 0.4 < margin < 0.91
    assert 150.0 < bandwidth < 901.0
    assert margin < 0.9 or bandwidth < 900.0
    with pytest.raises(ValueError, match=r"a modulus margin of 0\.999 is asked for, the nearest reaches 0\.9\d* with"):
        tuning.tune(family(least=300.0), [PLAIN], Specification(0.999), seed=1)


def test_plants_that_do_not_belong_together_are_refused():
    with pytest.raises(ValueError, match="nothing to tune for: give at least the nominal plant"):
        tuning.tune(PI, [], HALF, seed=1)
    with pytest.raises(ValueError, match=r"different control periods, 0\.0001 to 0\.0002 s: a controller has one rate"):
        tuning.tune(PI, [PLAIN, axis_plant(period_s=1e-4)], HALF, seed=1)
    with pytest.raises(ValueError, match=r"the plant has no disturbance: .*; give it one to reject"):
        tuning.tune(PI, [axis_plant(disturbance_rad=0.0)], HALF, seed=1)
    A = PLAIN.system.A.copy()
    A[-1, -1] = 1.0
    with pytest.raises(
        ValueError, match=r"a pole at \|z\| = 1\.0+ \(the limit is 1\).* give the disturbance some damp"
    ):
        tuning.tune(PI, [PLAIN, replace(PLAIN, system=replace(PLAIN.system, A=A))], HALF, seed=1)


def test_what_a_family_refuses_is_handed_on():
    def refuse(plant, values=None):
        raise ValueError("no gauge to damp with")

    with pytest.raises(ValueError, match=r"^no gauge to damp with$"):
        tuning.tune(Family("damping", refuse, pi), [PLAIN], HALF, seed=1)
    broken = Family("damping", PI.parameters, refuse)
    with pytest.raises(ValueError, match=r"no damping could be built in 100 tries; the first was refused: no gauge to"):
        tuning.tune(broken, [PLAIN], HALF, seed=1)


def test_candidates_that_cannot_be_built_are_left_out():
    def partly(plant, values):
        return pi(plant, [math.nan if values[0] > 600.0 else values[0], values[1]])

    found = tuning.tune(Family("PI", PI.parameters, partly), [PLAIN], HALF, seed=1)
    assert 300.0 < found.values["integral"] <= 600.0
    assert found.least_modulus >= 0.5


def test_a_grid_of_the_wrong_shape_is_refused():
    with pytest.raises(ValueError, match=r"1 rows of values for the parameters of PI \(integral, proportional\): give"):
        tuning.grid_best(PI, [PLAIN], HALF, [[1.0, 2.0]])


@pytest.mark.parametrize(("before", "overstated", "after"), [(0.2, 0.5, 0.5), (0.5, 0.2, 0.5), (0.0, 1.0, 1.0)])
def test_a_margin_that_was_overstated_is_asked_for_with_something_to_spare(monkeypatch, before, overstated, after):
    """The search takes the larger of what it has overstated so far, and more; then it settles again."""
    trial, looked = SimpleNamespace(score=1.0, values=(2.0,), place=np.zeros(1)), []
    judge = SimpleNamespace(optimism=before, of=lambda values, place: trial, at=lambda place: trial)

    def holds(search, found):
        looked.append(search.optimism)
        return len(looked) == 2

    monkeypatch.setattr(tuning, "settle", lambda search, found, models: found)
    monkeypatch.setattr(tuning, "_holds", holds)
    monkeypatch.setattr(tuning, "_overstated", lambda search, found: overstated)
    assert tuning.settled(judge, [trial]) is trial
    assert looked == [before, pytest.approx(after * (1.0 + tuning.HEADROOM), rel=1e-12)]
    assert tuning.HEADROOM > 0.0


@pytest.mark.parametrize(
    ("pole", "modulus", "bandwidth_hz", "holds"),
    [
        (0.99, 0.5, 100.0, True),
        (1.0, 0.5, 100.0, False),
        (0.99, 0.499, 100.0, False),
        (0.99, 0.5, 99.9, False),
        (0.99, 0.7, 200.0, True),
    ],
)
def test_a_trial_holds_at_the_very_specification_on_every_plant(pole, modulus, bandwidth_hz, holds):
    plants = [SimpleNamespace(modulus=m, bandwidth_hz=b) for m, b in ((0.9, 900.0), (modulus, bandwidth_hz))]
    judge = SimpleNamespace(specification=Specification(0.5, bandwidth_hz=100.0), margins=lambda trial: plants)
    trial = SimpleNamespace(verdict=SimpleNamespace(pole=pole), modulus=0.8)
    assert tuning._holds(judge, trial) is holds
    assert tuning._overstated(judge, trial) == (1.0 if pole == 1.0 else 0.8 / modulus)


@pytest.mark.parametrize(
    ("place", "costs", "said"),
    [
        (0.0, 1.0, ["least"]),
        (1e-4, 1.0, ["least"]),
        (1.0, 1.0, ["most"]),
        (0.9999, 1.0, ["most"]),
        (1e-3, 1.0, []),
        (1.0 - 1e-3, 1.0, []),
        (0.5, 1.0, []),
        (0.0, 0.0, []),
        (1.0, -1.0, []),
    ],
)
def test_a_parameter_is_bound_where_a_step_away_from_its_end_costs(place, costs, said):
    away = []

    def at(where):
        away.append(where.tolist())
        return SimpleNamespace(score=3.0 + costs)

    trial = SimpleNamespace(place=np.array([0.3, place]), cost=3.0)
    assert tuning._pressed(SimpleNamespace(at=at), trial, 1) == said
    assert all(each == [0.3, pytest.approx(0.05 if place < 0.5 else 0.95, abs=2e-4)] for each in away)
    assert trial.place[1] == place


def test_of_designs_for_larger_margins_that_hold_the_one_that_leaves_least_is_taken():
    left = {0.52: (4.0, True), 0.64: (3.0, True), 0.76: (1.0, False), 0.88: (2.0, True)}
    asked = []

    def tuned(margin, out_of_reach=0.88):
        asked.append(round(margin, 9))
        if asked[-1] >= out_of_reach:
            raise ValueError("out of reach")
        return asked[-1]

    def judged(designs):
        return [SimpleNamespace(simulated_rad=left[each][0], holds=left[each][1]) for each in designs]

    design, figure = promises.firmer(0.4, tuned, judged)
    assert (design, figure.simulated_rad, asked) == (0.64, 3.0, [0.52, 0.64, 0.76, 0.88])
    assert promises.firmer(0.4, lambda margin: tuned(margin, 2.0), judged)[0] == 0.88
    assert promises.firmer(0.4, lambda margin: tuned(margin, 0.0), None) is None
    assert promises.firmer(0.4, lambda margin: 0.76, judged) is None


def test_the_parameters_of_a_trial_are_told_in_plain_numbers():
    search = SimpleNamespace(
        parameters=[SimpleNamespace(name="ki", unit="V/(rad s)"), SimpleNamespace(name="n", unit="")]
    )
    assert tuning._with(search, SimpleNamespace(values=[123_456.0, 2.5])) == "ki 123500 V/(rad s), n 2.5"


# ------------------------------------------------------------------------------------------- parts of a search by hand
LOG, EVEN = Parameter("a", "Hz", 2.0, 200.0), Parameter("b", "", -3.0, 5.0, log=False, gentle=1.0)


@pytest.mark.parametrize(
    ("parameter", "place", "number"),
    [(LOG, 0.0, 2.0), (LOG, 0.5, 20.0), (LOG, 1.0, 200.0), (LOG, 0.25, 2.0 * 10**0.5), (LOG, 1.5, 2000.0),
     (EVEN, 0.0, -3.0), (EVEN, 0.25, -1.0), (EVEN, 1.0, 5.0), (EVEN, 1.25, 7.0)],
)  # fmt: skip
def test_a_place_is_the_share_of_a_parameters_bounds_on_its_own_scale(parameter, place, number):
    assert search.value(parameter, place) == near(number)
    assert search.place_of(parameter, number) == near(place)


def test_a_value_below_the_least_stands_at_the_least():
    assert [search.place_of(p, v) for p, v in ((LOG, 1.9), (LOG, -4.0), (EVEN, -3.5))] == [0.0] * 3


@pytest.mark.parametrize(
    ("number", "used"),
    [(123456.0, 123500.0), (-0.000987651, -0.0009877), (1.00049, 1.0), (99994.0, 99990.0), (99996.0, 1e5), (0.0, 0.0)],
)
def test_values_are_used_to_four_digits(number, used):
    assert search.rounded(number) == used


@pytest.mark.parametrize(
    ("most", "distance", "kept"), [(9, 0.1, "abd"), (2, 0.1, "ab"), (9, 0.0999, "abcd"), (9, 0.5, "a"), (0, 0.1, "")]
)
def test_trials_lie_apart_in_one_parameter_at_least_and_the_first_are_preferred(most, distance, kept):
    places = {"a": (0.5, 0.5), "b": (0.5, 0.75), "c": (0.6, 0.75), "d": (0.7, 0.5), "e": (0.5, 0.5)}
    trials = [SimpleNamespace(name=name, place=np.array(place)) for name, place in places.items()]
    assert "".join(t.name for t in search.apart(trials, most, distance)) == kept


@pytest.mark.parametrize(
    ("excess", "violation", "score"), [([0.2, -0.03, 0.1], 0.03, 2.3), ([0.2, 0.0], 0.0, 2.0), ([0.5], 0.0, 2.0)]
)
def test_a_trial_is_scored_by_its_cost_and_ten_times_its_worst_violation(excess, violation, score):
    verdict = judge.Verdict(0.5, 1.0, np.array([0.9, 0.4, 0.6]), np.array([3.0]))
    trial = search.Trial(np.zeros(1), np.zeros(1), verdict, 2.0, np.array(excess))
    assert (trial.modulus, trial.violation, trial.score) == (0.4, near(violation) if violation else 0.0, near(score))


def fake_search(verdicts, asked, pull=0.0, parameters=(LOG, EVEN), build=lambda plant, values: tuple(values)):
    """A search whose judge knows its verdicts by the first value."""

    def several(controllers):
        return [verdicts[c[0]] for c in controllers]

    judging = SimpleNamespace(
        open_rad2=math.exp(4.0), several=several, unstable=lambda p: judge.Verdict(p, math.inf, *NONE)
    )
    scope = search.Scope(lambda plants: judging, lambda plant, made: None, lambda plant, made: (plant, made))
    return search.Search(Family("f", lambda plant: parameters, build), ["p", "q"], asked, pull, scope)


NONE = np.zeros(3), np.zeros(2)
MODULI, BANDS = np.array([0.7, 0.45, 0.9]), np.array([80.0, 125.0])


@pytest.mark.parametrize(
    ("verdict", "asked", "cost", "excess"),
    [
        ((0.9, 9.0, MODULI, BANDS), (0.5, 0.0), math.log(3.0), (MODULI - 0.5005) / 0.5),
        ((0.9, 9.0, MODULI, BANDS), (0.05, 0.0), math.log(3.0), (MODULI - 0.05005) / 0.1),
        ((0.9, 9.0, MODULI, BANDS), (0.5, 100.0), math.log(3.0),
         [*(MODULI - 0.5005) / 0.5, math.log(0.8 / 1.001), math.log(1.25 / 1.001)]),
        ((0.9, 9.0, MODULI, BANDS), (0.5, 1e4), math.log(3.0), [*(MODULI - 0.5005) / 0.5] + [math.log(0.1)] * 2),
        ((0.9, 1e9, MODULI, BANDS), (0.5, 0.0), 3.0, (MODULI - 0.5005) / 0.5),
        ((1.25, math.inf, *NONE), (0.5, 0.0), 3.25, [-1.001 - 0.25] * 3),
        ((1.0, math.inf, *NONE), (0.5, 0.0), 3.0, [-1.001] * 3),
        ((7.0, math.inf, *NONE), (0.5, 10.0), 4.0, [-2.001] * 3 + [math.log(0.1) - 1.0] * 2),
    ],
)  # fmt: skip
def test_a_trial_costs_the_logarithm_of_its_rms_and_exceeds_what_is_asked_for_with_some_headroom(
    verdict, asked, cost, excess
):
    looked = fake_search({20.0: judge.Verdict(*verdict)}, Specification(*asked))
    trial = looked.of(np.array([20.0, 3.0]))
    assert trial.cost == near(cost)
    assert trial.excess.tolist() == near([*excess])
    assert trial.place.tolist() == near([0.5, 0.75])
    assert (looked.count, looked.trials) == (1, [trial])
    looked.optimism = 1.5
    stricter = looked.of(np.array([20.0, 3.0])).excess[:3]
    assert trial.excess[:3] - stricter == near(asked[0] * 0.5 * 1.001 / max(asked[0], 0.1) * np.ones(3))


def test_a_vigorous_value_costs_by_the_square_of_its_distance_from_the_gentle_one():
    looked = fake_search(dict.fromkeys([20.0, 2.0], judge.Verdict(0.5, 1.0, MODULI, BANDS)), HALF, pull=0.01)
    assert looked.of(np.array([20.0, 3.0])).cost == near(0.01 * (0.25 + 0.0625))  # b is gentle at 1, half way
    assert looked.at(np.array([-0.5, 0.5])).cost == pytest.approx(0.0, abs=1e-12)
    assert looked.at(np.array([-0.5, 7.0])).place.tolist() == [0.0, 1.0]


def test_candidates_are_judged_in_their_order_and_what_cannot_be_built_is_unstable_for_the_first_reason():
    def build(plant, values):
        assert plant == "p"
        if values[1] < 0.0:
            raise ValueError(f"no {values[0]:g}")
        return tuple(values)

    known = {v: judge.Verdict(0.1 * v, v, MODULI, BANDS) for v in (2.0, 3.0, 5.0)}
    looked = fake_search(known, HALF, build=build)
    found = looked.of_all([np.array(v) for v in ((2.0, 1.0), (4.0, -1.0), (5.0, 0.0), (7.0, -2.0), (3.0, 2.0))])
    assert [t.verdict.pole for t in found] == near([0.2, math.inf, 0.5, math.inf, 0.3])
    assert [t.values[0] for t in looked.trials] == [2.0, 5.0, 3.0]
    assert (looked.count, str(looked.reason)) == (5, "no 4")
    margins = looked.margins(found[2])
    assert margins == [("p", (5.0, 0.0)), ("q", (5.0, 0.0))]
    assert looked.margins(found[2]) is margins
    assert looked.margins(found[0]) == [("p", (2.0, 1.0)), ("q", (2.0, 1.0))]


@pytest.mark.parametrize("x", [0.0, 1e-3, 3e-3, 0.4, 0.997, 0.9985, 1.0])
def test_the_derivatives_of_a_quartic_are_exact_wherever_its_points_have_to_stand(x):
    node, quartic = 3e-3, np.polynomial.Polynomial([0.3, -1.0, 2.0, 5.0, -7.0])
    offsets = descent._offsets(x, node)
    assert offsets.tolist() == near([*np.arange(-2.0, 3.0) + offsets[2]])
    assert np.min(x + node * offsets) >= -1e-12
    assert np.max(x + node * offsets) <= 1.0 + 1e-12
    assert abs(offsets[2]) <= 2.0
    for order in (1, 2):
        found = descent._weights(offsets, order) @ quartic(x + node * offsets) / node**order
        assert found == pytest.approx(quartic.deriv(order)(x), rel=1e-6)


def judged_by(numbers, pole=lambda place: 0.5):
    """A search of two parameters that counts the places it is asked for."""
    asked = []

    def at_all(places):
        asked.append([np.array(place) for place in places])
        return [SimpleNamespace(
            place=np.clip(p, 0.0, 1.0), cost=numbers(p)[0], excess=np.array(numbers(p)[1:]),
            score=numbers(p)[0] + 10.0 * max(0.0, -min(numbers(p)[1:])),
            verdict=SimpleNamespace(pole=pole(p))) for p in places]  # fmt: skip

    return SimpleNamespace(at_all=at_all, at=lambda place: at_all([place])[0], asked=asked)


def bowl(place):
    x, y = place[0] - 0.3, place[1] - 0.6
    return [2.0 + 3.0 * x**2 + 5.0 * y**2 + 1.5 * x * y, 0.2 + x - 2.0 * y, 0.9]


@pytest.mark.parametrize("place", [(0.5, 0.4), (0.0, 0.55), (1.0, 1.0), (0.31, 0.0)])
def test_the_model_of_cost_and_near_constraints_has_their_value_slope_and_bend(place):
    looked, at = judged_by(bowl), np.array(place)
    model = descent._model(looked, looked.at(at), 3e-3)
    x, y = at - [0.3, 0.6]
    rows = 1 + (0.2 + x - 2 * y < 0.3)
    assert model.value.tolist() == near(bowl(at)[:rows])
    assert model.slope[:1].tolist() == [pytest.approx([6 * x + 1.5 * y, 10 * y + 1.5 * x], abs=1e-8)]
    assert model.slope[1:].tolist() == [pytest.approx([1.0, -2.0], abs=1e-8)][: rows - 1]
    assert model.bend[0].tolist() == [pytest.approx([6.0, 1.5], abs=1e-5), pytest.approx([1.5, 10.0], abs=1e-5)]
    step = np.array([0.02, -0.05])
    assert model.at(step).tolist() == pytest.approx(bowl(at + step)[:rows], abs=1e-7)
    assert model.gradient(step)[0].tolist() == pytest.approx(
        [6 * (x + 0.02) + 1.5 * (y - 0.05), 10 * (y - 0.05) + 1.5 * (x + 0.02)], abs=1e-6
    )
    assert len(looked.asked[1]) == 4 * 2 + 4
    assert (
        descent._model(judged_by(bowl, lambda p: 1.0 if p[1] > at[1] or p[1] < at[1] else 0.5), looked.at(at), 3e-3)
        is None
    )


@pytest.mark.parametrize("start", [(0.5, 0.4), (0.05, 0.95), (0.0, 0.0), (1.0, 1.0)])
def test_an_optimum_is_the_least_cost_at_which_no_constraint_is_missed(start):
    """Least of the bowl where 0.2 + x - 2 y is at least 0, which the bowl's own least is."""
    for numbers, least in ((bowl, (0.3, 0.6)), (lambda place: [bowl(place)[0], place[0] - 0.4], (0.4, 0.585))):
        looked = judged_by(numbers)
        rough, found = (of(looked, looked.at(np.array(start))) for of in (descent.descend, descent.settle))
        assert rough.place.tolist() == pytest.approx(least, abs=1e-3)
        assert found.place.tolist() == pytest.approx(least, abs=1e-7)


@pytest.mark.parametrize(("reach", "moved"), [(0.1, 0.1), (0.02, 0.02), (0.5, 0.3)])
def test_the_step_of_a_model_goes_no_farther_than_it_is_trusted_but_to_meet_a_constraint(reach, moved):
    flat = descent._Quadratic(np.array([4.0]), np.array([[1.0, 0.0]]), np.zeros((1, 2, 2)))
    assert descent._optimum(flat, np.array([0.3, 0.5]), reach)[0] == pytest.approx(-moved, abs=1e-9)
    missed = descent._Quadratic(np.array([4.0, -0.05]), np.array([[0.0, 1.0], [1.0, 0.0]]), np.zeros((2, 2, 2)))
    found = descent._optimum(missed, np.array([0.3, 0.5]), reach)
    assert (
        found.tolist() == pytest.approx([0.05, -max(reach, 0.1)], abs=1e-6) if reach < 0.5 else found[0] >= 0.05 - 1e-9
    )


@pytest.mark.parametrize(("dimensions", "count", "seed"), [(1, 7, 3), (3, 20, 5), (0, 4, 1)])
def test_places_of_a_hypercube_have_one_in_each_part_of_each_bound(dimensions, count, seed):
    found = tuning.hypercube(dimensions, count, seed)
    assert found.shape == (count, dimensions)
    assert (np.sort(np.floor(found * count), axis=0) == np.arange(count)[:, None]).all()
    assert (tuning.hypercube(dimensions, count, seed) == found).all()
    if dimensions:
        assert (tuning.hypercube(dimensions, count, seed + 1) != found).any()


def tried(*trials, plants=("p", "q"), asked=HALF, margins=None):
    """A search that has tried these, each by pole, moduli, bandwidths, cost and its values of two parameters."""
    made = [
        SimpleNamespace(verdict=SimpleNamespace(pole=pole, bandwidths_hz=np.array(bands)), modulus=min(moduli),
                        cost=cost, violation=max(0.0, asked.modulus_margin - min(moduli)), values=np.array(values))
        for pole, moduli, bands, cost, values in trials
    ]  # fmt: skip
    return SimpleNamespace(
        trials=made, specification=asked, count=17, plants=plants, reason="no such gain", parameters=(LOG, EVEN),
        family=SimpleNamespace(name="PI + X"), margins=lambda t: margins or [],
    )  # fmt: skip


def test_candidates_meet_what_is_asked_for_just_so_and_the_cheapest_stands_first():
    rows = [
        (0.9, [0.5], [90.0, 80.0], 3.0, (1.0, 1.0)), (0.9, [0.4999], [90.0, 99.0], 1.0, (2.0, 1.0)),
        (1.0, [0.9], [90.0, 99.0], 0.5, (3.0, 1.0)), (0.99, [0.6], [99.0, 79.9], 0.7, (4.0, 1.0)),
        (0.99, [0.6, 0.7], [99.0, 85.0], 2.0, (5.0, 1.0)),
    ]  # fmt: skip
    found = tuning._candidates(tried(*rows, asked=Specification(0.5, 80.0)))
    assert [t.values[0] for t in found] == [5.0, 1.0]
    assert [t.values[0] for t in tuning._candidates(tried(*rows))] == [4.0, 5.0, 1.0]


UNSTABLE = (1.3, [0.0], [0.0, 0.0], 9.0, (120.0, -2.0)), (1.0625, [0.0], [0.0, 0.0], 9.5, (34.5678, 0.5))
STABLE = (0.9, [0.31], [40.0, 9.0], 2.0, (50.0, 1.0)), (0.8, [0.31], [9.0, 7.0], 1.0, (70.0, 4.0))
REACHED = [SimpleNamespace(modulus=0.41, bandwidth_hz=33.333), SimpleNamespace(modulus=0.3125, bandwidth_hz=44.0)]


@pytest.mark.parametrize(
    ("rows", "more", "words"),
    [
        ((), {}, "no PI + X could be built in 17 tries; the first was refused: no such gain"),
        (UNSTABLE, {}, "no PI + X of 17 tried is stable on all 2 plants: the nearest has a pole at |z| = 1.062500 (the "
         "limit is 1) with a 34.57 Hz, b 0.5; shorten the delay, narrow what is unknown of the plant, or take another "
         "controller"),
        (UNSTABLE[:1], {"plants": ("p",)}, "no PI + X of 17 tried is stable: the nearest has a pole at |z| = 1.300000 "
         "(the limit is 1) with a 120 Hz, b -2; shorten the delay, narrow what is unknown of the plant, or take "
         "another controller"),
        ((*UNSTABLE, *STABLE), {"margins": REACHED}, "no PI + X of 17 tried meets the specification on all 2 plants: a "
         "modulus margin of 0.5 is asked for, the nearest reaches 0.312 with a 70 Hz, b 4; ask for less, shorten the "
         "delay, or take another controller"),
        (STABLE[:1], {"margins": REACHED, "asked": Specification(0.625, 120.5), "plants": ("p",)}, "no PI + X of 17 "
         "tried meets the specification: a modulus margin of 0.625 and a bandwidth of 120.5 Hz is asked for, the "
         "nearest reaches 0.312 and 33.33 Hz with a 50 Hz, b 1; ask for less, shorten the delay, or take another "
         "controller"),
    ],
)  # fmt: skip
def test_a_tuning_that_fails_says_what_the_nearest_has_on_how_many_plants(rows, more, words):
    assert tuning._refusal(tried(*rows, **more)) == words


@pytest.mark.parametrize(
    ("modulus", "bandwidth_hz", "asked", "bound"),
    [
        (0.505, 300.0, Specification(0.5, 100.0), ("modulus margin", "b at its most")),
        (0.506, 300.0, Specification(0.5, 100.0), ("b at its most",)),
        (0.506, 101.0, Specification(0.5, 100.0), ("bandwidth", "b at its most")),
        (0.4, 50.0, Specification(0.5, 0.0), ("modulus margin", "b at its most")),
        (0.506, 0.0, Specification(0.5, 0.0), ("b at its most",)),
    ],
)
def test_a_tuned_controller_is_told_by_its_first_plant_its_worst_and_all_of_them(
    monkeypatch, modulus, bandwidth_hz, asked, bound
):
    """Variances of 9, 16 and 2 beside noise of 0; margins of which the second is the worst."""
    each = ((0.95, 500.0), (modulus, 400.0), (0.94, bandwidth_hz))
    margins = {p: SimpleNamespace(modulus=m, bandwidth_hz=b) for p, (m, b) in zip("pqr", each, strict=True)}
    left = {"p": [4.0, 5.0], "q": [16.0, 0.0], "r": [1.5, 0.5]}
    monkeypatch.setattr(tuning, "close", lambda plant, controller: (plant, controller))
    monkeypatch.setattr(tuning, "h2", lambda closed: np.array([left[closed[0]], [99.0, 1.0]]))
    monkeypatch.setattr(tuning, "loop_margins", lambda plant, controller: margins[plant])
    built = Family(
        "f", lambda plant: (), lambda plant, v: ("search", plant), final=lambda plant, v: ("final", plant, *v)
    )
    looked = SimpleNamespace(
        family=built, plants="pqr", specification=asked, count=23, parameters=(LOG, EVEN),
        at=lambda place: SimpleNamespace(score=5.0 if place[1] < 1.0 else 0.0),
    )  # fmt: skip
    found = tuning._tuned(looked, SimpleNamespace(values=(30.0, 5.0), place=np.array([0.4, 1.0]), cost=1.0))
    assert found.controller == ("final", "p", 30.0, 5.0)
    assert found.values == {"a": 30.0, "b": 5.0}
    assert (found.residual_rms_rad, found.mean_rms_rad, found.worst_rms_rad) == near((3.0, 3.0, 4.0))
    assert (found.margins, found.evaluations, found.bound_by) == (margins["p"], 23, bound)
    assert (found.least_modulus, found.least_bandwidth_hz) == (modulus, min(bandwidth_hz, 400.0))


def test_a_grid_is_looked_at_from_its_cheapest_on_until_one_holds_closely(monkeypatch):
    rows = [(0.9, [0.6], [9.0, 9.0], 40.0 - k, (float(k), 1.0)) for k in range(40)]
    looked = tried(*rows)
    holds, asked = {20.0, 13.0}, []
    monkeypatch.setattr(tuning, "_holds", lambda s, t: asked.append(t.values[0]) or t.values[0] in holds)
    monkeypatch.setattr(tuning, "_tuned", lambda s, t: t.values[0])
    monkeypatch.setattr(tuning, "_refusal", lambda s: "none of them")
    assert (tuning._chosen(looked), asked) == (20.0, [float(k) for k in range(39, 19, -1)])
    holds.clear()
    asked.clear()
    with pytest.raises(ValueError, match="none of them"):
        tuning._chosen(looked)
    assert len(asked) == 30


# ------------------------------------------------------------------------------------------------ the judge by parts
@pytest.mark.parametrize("freq", [[0.1, 0.3, 0.35, 2.0], [5.0], [1.0, 4.0]])
def test_a_spectrum_counts_by_trapezia_and_as_at_its_lowest_frequency_down_to_zero(freq):
    f = np.array(freq)
    values = 3.0 + 2.0 * f
    expected = values[0] * f[0] + np.sum(0.5 * (values[1:] + values[:-1]) * np.diff(f))
    assert judge.quadrature(f) @ values == near(expected)


@pytest.mark.parametrize(("poles", "lowest"), [([0.3], 1e-4 / 20), ([0.5, np.exp(-1e-5)], 1e-5 / (2 * np.pi) / 20),
                                               ([1.0 - 1e-16], 1e-9), ([], 1e-4 / 20)])  # fmt: skip
def test_a_grid_begins_below_the_slowest_pole_and_ends_at_half_the_rate(poles, lowest):
    n = len(poles)
    system = lti.StateSpace(np.diag(poles), np.ones((n, 1)), np.ones((1, n)), np.zeros((1, 1)))
    found = judge.grid(system, 2e-3)
    assert (found[0], found[-1], found.size) == (near(lowest / 2e-3), near(250.0), pytest.approx(350, abs=12))
    assert (np.diff(found) > 0.0).all()
    assert {round(f, 6) for f in 500.0 * np.linspace(0.0, 0.5, 121)[1:]} <= {round(f, 6) for f in found.tolist()}


def test_bands_are_one_below_a_thousandth_of_the_rate_and_ten_above_by_plant():
    period = 1e-3
    edges = np.geomspace(1e-3, 0.5, 11) / period
    first = np.array([0.5, 0.9, edges[0], edges[3] * 1.01, edges[3] * 1.02, edges[9] * 1.1, 500.0])
    second = np.array([edges[2] * 1.01, 400.0])
    assert judge._bands([first, second], period).tolist() == [0, 2, 3, 5, 7, 8]
    assert judge._bands([0.9999 * edges], period).tolist() == [*range(11)]
    assert judge._bands([edges[1:]], period).tolist() == [*range(9)]


@pytest.mark.parametrize("order", [0, 1, 2, 4])
def test_responses_of_controllers_of_any_order_are_those_of_their_matrices(order):
    random = np.random.default_rng(order)
    shapes = (order, order), (order, 2), (1, order), (1, 2)
    several = [lti.StateSpace(*(0.4 * random.standard_normal(shape) for shape in shapes)) for _ in range(3)]
    points = np.exp(1j * np.array([0.1, 1.3, 2.9, np.pi]))
    found = judge.responses(judge._Stack.of(several), points)
    assert found.shape == (3, 4, 2)
    for s, rows in zip(several, found, strict=True):
        for z, row in zip(points, rows, strict=True):
            expected = s.C @ np.linalg.solve(z * np.eye(order) - s.A, s.B) + s.D
            np.testing.assert_allclose(row, expected[0], rtol=1e-9)
        np.testing.assert_allclose(judge.response(s, points), rows, rtol=1e-12)
    stack = judge._Stack.of(several).some(np.array([2, 0]))
    assert (stack.D[0] == several[2].D).all()
    assert (stack.B[1] == several[0].B).all()


@pytest.mark.parametrize(
    ("plants", "words"),
    [
        ((), "nothing to tune for: give at least the nominal plant"),
        ((PLAIN, replace(PLAIN, period_s=5e-4)), "plants of different control periods, 0.0002 to 0.0005 s: a "
         "controller has one rate"),
        ((PLAIN, replace(PLAIN, system=replace(PLAIN.system, A=np.diag(np.linspace(0.2, 1.0, PLAIN.system.order))))),
         "a plant has a pole at |z| = 1.000000000 (the limit is 1): it or its disturbance is not stationary; give the "
         "disturbance some damping"),
        ((replace(PLAIN, system=replace(PLAIN.system, B=PLAIN.system.B * [1.0, 0.0, 0.0, 0.0])),),
         "the plant has no disturbance: without a loop its residual is 0; give it one to reject"),
    ],
)  # fmt: skip
def test_a_judge_refuses_plants_that_it_cannot_judge_on(plants, words):
    with pytest.raises(ValueError) as refused:
        judge.Judge(plants)
    assert str(refused.value) == words


def whole_search(monkeypatch, roughs, contained, settled_at, holds=lambda t: True):
    """A tuning whose local searches end at these scores, and what it asks of its parts."""
    asked, left = {"from": [], "settled": []}, iter(roughs)

    def trial(score, mean, pole=0.5, place=None):
        where = np.array([score % 1.0 if place is None else place])
        return SimpleNamespace(score=score, mean_rms_rad=mean, verdict=SimpleNamespace(pole=pole), place=where)

    inner = [trial(9.0 + 0.001 * i, *each) for i, each in enumerate(contained)]
    surveyed = [trial(n, 0.0, place=0.11 * n) for n in (5.0, 9.0, 3.0, 8.0, 4.0, 7.0)]
    looked = SimpleNamespace(trials=[1], at_all=lambda places: surveyed)
    monkeypatch.setattr(tuning, "Search", lambda *given: looked)
    monkeypatch.setattr(tuning, "_contained", lambda *given: inner)
    monkeypatch.setattr(tuning, "_places", lambda *given: ())
    monkeypatch.setattr(tuning, "descend", lambda s, start: asked["from"].append(start.score) or trial(next(left), 0.0))
    monkeypatch.setattr(
        tuning, "settled", lambda s, some: asked["settled"].extend(t.score for t in some) or trial(0.0, settled_at)
    )
    monkeypatch.setattr(tuning, "_tuned", lambda s, t: t)
    monkeypatch.setattr(tuning, "_holds", lambda s, t: holds(t))
    monkeypatch.setattr(tuning, "_variances", lambda s, t: (None, [t.mean_rms_rad**2]))
    asked["found"] = tuning.tune(SimpleNamespace(name="f"), "pq", HALF, seed=1, survey=6)
    return asked


def test_local_searches_set_out_from_the_best_of_both_halves_in_turn_and_the_near_optima_are_followed(monkeypatch):
    """Halves of 3, 4, 5 and 7, 8, 9 behind what is contained; of the ends those within 1e-4 of the least, and apart."""
    roughs = (2.5, 2.00009, 2.9, 2.03, 2.7, 2.00001, 2.8)
    asked = whole_search(monkeypatch, roughs, [(7.0,)], 4.0)
    assert asked["from"] == [9.0, 3.0, 7.0, 4.0, 8.0, 5.0, 9.0]
    assert asked["settled"] == [2.00001]  # 2.00009 lies at the same place, the next ones are dearer
    again = whole_search(monkeypatch, (2.3, 2.30002, 2.30009, 9.9, 9.9, 9.9), [], 4.0)
    assert (again["from"], again["settled"]) == ([3.0, 7.0, 4.0, 8.0, 5.0, 9.0], [2.3])
    agreed = whole_search(monkeypatch, (2.3, 2.300001, 2.300002, 9.9), [], 4.0)
    assert agreed["from"] == [3.0, 7.0, 4.0]


@pytest.mark.parametrize(
    ("contained", "dead", "mean"),
    [
        ([(3.0,), (2.0,)], (), 2.0), ([(2.0,), (3.0,)], (), 2.0), ([(5.0,)], (), 4.0), ([], (), 4.0),
        ([(3.0, 1.0), (3.5,)], (), 3.5),  # unstable
        ([(3.0,), (3.5,)], (3.0,), 3.5), ([(3.0,)], (3.0,), 4.0), ([(4.0,)], (), 4.0),
    ],
)  # fmt: skip
def test_of_what_a_family_contains_the_best_that_holds_is_taken_where_it_leaves_less(
    monkeypatch, contained, dead, mean
):
    ends = [2.0 + 0.1 * i for i in range(8)]
    found = whole_search(monkeypatch, ends, contained, 4.0, lambda t: t.mean_rms_rad not in dead)["found"]
    assert (found.mean_rms_rad, found.verdict.pole) == (mean, 0.5)


def test_of_optima_that_are_as_good_the_one_of_the_smaller_values_is_rounded_and_kept_at_its_place(monkeypatch):
    asked = []

    def optimum(score, *values):
        return SimpleNamespace(score=score, values=values, place=f"place of {values[0]:g}")

    optima = [optimum(1.0000004, 7.00049, 1.0), optimum(1.0, 5.00049, 3.0), optimum(0.9999998, 5.00049, 2.00019),
              optimum(1.1, 1.0, 1.0)]  # fmt: skip
    looked = SimpleNamespace(of=lambda values, place: asked.append((values.tolist(), place)) or "found")
    monkeypatch.setattr(tuning, "settle", lambda s, t, models: asked.append(models) or t)
    monkeypatch.setattr(tuning, "_holds", lambda s, found: True)
    assert tuning.settled(looked, optima, 3) == "found"
    assert asked == [3, 3, 3, 3, ([5.0, 2.0], "place of 5.00049")]
    asked.clear()
    assert tuning.settled(looked, optima[::-1]) == "found"
    assert asked == [25, 25, 25, 25, ([5.0, 2.0], "place of 5.00049")]


def test_a_margin_that_stays_overstated_is_sought_four_times_each_from_where_the_last_ended(monkeypatch):
    begun, looked = [], SimpleNamespace(optimism=1.0)
    looked.of = lambda values, place: SimpleNamespace(n=len(begun))
    looked.at = lambda place: SimpleNamespace(score=2.0, values=(1.0,), place=f"judged {place}")
    monkeypatch.setattr(tuning, "settle", lambda s, t, models: begun.append(t.place) or SimpleNamespace(
        score=1.0, values=(1.0,), place=f"{len(begun)}"))  # fmt: skip
    monkeypatch.setattr(tuning, "_holds", lambda s, found: False)
    monkeypatch.setattr(tuning, "_overstated", lambda s, found: 1.0 + 0.5 * (found.n == 2))
    monkeypatch.setattr(tuning, "_refusal", lambda s: "out of reach" if s is looked else "")
    with pytest.raises(ValueError, match=r"^out of reach$"):
        tuning.settled(looked, [SimpleNamespace(place="first")])
    assert begun == ["first", "judged 1", "judged 2", "judged 3"]
    assert looked.optimism == near(1.5 * 1.001**3)


@pytest.mark.parametrize(
    ("ends", "models", "steps", "place"),
    [
        # each end: score behind the step of the model, or None for a place without a model
        ((3.0, 2.0, 1.0), 3, [(0.1, 3e-3)] * 3, 0.53),
        ((3.0, 2.0, 1.0), 2, [(0.1, 3e-3)] * 2, 0.52),
        ((3.0, 5.0, 2.0, 2.0 + 5e-10, 2.5, 1.0), 6,
         [(0.1, 3e-3)] * 2 + [(0.025, 1.5e-3)] * 3 + [(0.00625, 7.5e-4)], 0.54),
        ((3.0, None, 1.0), 9, [(0.1, 3e-3)] * 2, 0.51),
        ((3.0, "still", 1.0), 9, [(0.1, 3e-3)] * 2, 0.51 + 9e-9),
        ((9.0,) * 20, 20, [(0.1 * 0.25**k, 3e-3 * 0.5**k) for k in range(6)], 0.5),
    ],
)  # fmt: skip
def test_models_reach_less_far_where_one_has_misled_and_end_where_a_step_stands_still(
    monkeypatch, ends, models, steps, place
):
    """Each step goes 0.01 on, from a trial of score 4; one that stands still 9e-9, of whatever score."""
    asked, left = [], iter(ends)
    now = [None]

    def model(search, here, node):
        now[0] = next(left)
        asked.append(node)
        return None if now[0] is None else "a model"

    def optimum(model, where, reach):
        asked[-1] = (near(reach), near(asked[-1]))
        return np.array([9e-9 if now[0] == "still" else 0.01])

    def at(where):
        return SimpleNamespace(place=where, score=99.0 if now[0] == "still" else now[0])

    monkeypatch.setattr(descent, "_model", model)
    monkeypatch.setattr(descent, "_optimum", optimum)
    start = SimpleNamespace(place=np.array([0.5]), score=4.0)
    found = descent.settle(SimpleNamespace(at=at), start, models)
    assert found.place.tolist() == [pytest.approx(place, abs=2e-9)]
    assert len(asked) == len(steps)
    for took, step in zip(asked, steps, strict=True):
        assert (took if isinstance(took, tuple) else (near(step[0]), near(took))) == step


@pytest.mark.parametrize("pole", [1.0, -1.0, -1.25, 1.5])
def test_a_plant_that_is_not_stationary_is_refused_whichever_way_its_pole_lies_and_wherever_the_plant_stands(pole):
    n = PLAIN.system.order
    poles = np.linspace(0.2, 0.7, n)
    poles[1] = pole
    loud = replace(PLAIN, system=replace(PLAIN.system, A=np.diag(poles)))
    for plants in ((PLAIN, loud), (loud, PLAIN), (loud,)):
        with pytest.raises(ValueError) as refused:
            judge.Judge(plants)
        assert str(refused.value) == (
            f"a plant has a pole at |z| = {abs(pole):.9f} (the limit is 1): it or its disturbance is not stationary; "
            "give "
            "the disturbance some damping"
        )
    poles[1] = 0.999 * pole / abs(pole)
    assert judge.Judge([replace(PLAIN, system=replace(PLAIN.system, A=np.diag(poles)))]).open_rad2 > 0.0


@pytest.mark.parametrize("error", [RuntimeError, KeyError, TypeError])
def test_what_is_no_refusal_ends_a_search_instead_of_being_taken_for_one(monkeypatch, error):
    def fails(*given, **named):
        raise error("broken")

    looked = fake_search({}, HALF, build=fails)
    with pytest.raises(error, match="broken"):
        looked.of(np.array([1.0, 2.0]))
    assert (looked.reason, looked.count, looked.trials) == (None, 0, [])
    monkeypatch.setattr(tuning, "tune", fails)
    containing = SimpleNamespace(
        family=SimpleNamespace(base=PI, extended=lambda plant, values: values), plants=[PLAIN], specification=HALF
    )
    with pytest.raises(error, match="broken"):
        tuning._contained(containing, 1, 10, None)
    with pytest.raises(error, match="broken"):
        promises.firmer(0.4, fails, lambda designs: [])


def test_of_a_controller_that_does_not_fit_its_plant_the_first_reason_is_kept():
    def misfit(plant, controller):
        if controller[0] > 2.0:
            raise ValueError(f"{controller[0]:g} does not fit {plant}")

    known = {v: judge.Verdict(0.1 * v, v, MODULI, BANDS) for v in (1.0, 2.0)}
    looked = fake_search(known, HALF, build=lambda plant, values: tuple(values))
    looked._scope = replace(looked._scope, misfit=misfit)
    found = looked.of_all([np.array([v, 0.5]) for v in (1.0, 3.0, 2.0, 4.0)])
    assert [t.verdict.pole for t in found] == near([0.1, math.inf, 0.2, math.inf])
    assert str(looked.reason) == "3 does not fit p"


def test_a_gentle_value_of_nothing_is_one_and_without_any_the_least_is_gentle():
    even = partial(Parameter, unit="", log=False)
    parameters = (
        even("feedback", least=-3.0, most=1.0, gentle=0.0),
        even("least", least=-3.0, most=1.0),
        even("most", least=-3.0, most=1.0, gentle=1.0),
    )
    looked = fake_search({}, HALF, parameters=parameters)
    assert looked._gentle.tolist() == near([0.75, 0.0, 1.0])


def test_the_nearest_to_what_is_asked_for_misses_least_and_of_those_leaves_least(monkeypatch):
    verdict = partial(judge.Verdict, mean_rad2=1.0, bandwidths_hz=BANDS)
    known = (0.9, 1.0, -0.5), (0.9, 3.0, -0.2), (0.9, 2.0, -0.2), (1.2, 0.0, -0.1), (0.9, 9.0, -0.4)
    trials = [
        search.Trial(NONE[0], NONE[0], verdict(pole=pole, moduli=MODULI), cost, np.array([excess, 1.0]))
        for pole, cost, excess in known
    ]
    monkeypatch.setattr(tuning, "_out_of_reach", lambda search, best: best)
    monkeypatch.setattr(tuning, "_no_stable", lambda search: "none")
    assert tuning._refusal(SimpleNamespace(trials=trials)) is trials[2]
    assert tuning._refusal(SimpleNamespace(trials=trials[3:4])) == "none"
