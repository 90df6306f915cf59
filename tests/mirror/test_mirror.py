"""Mirrors against hand-written simulations, numerical slopes and the plants that they are made of."""

import re
from dataclasses import astuple, replace
from math import exp, inf, nan, pi
from types import SimpleNamespace

import numba
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.signal import lsim

import oracles
from loops import side_by_side
from microrad.core import kernels, lti
from microrad.core.units import LEAST, MOST
from microrad.loop import control
from microrad.loop import sine_run as simulate
from microrad.mirror import hysteresis
from microrad.mirror import model as mirror
from microrad.mirror import summary as mirror_summary
from microrad.mirror.hysteresis import BoucWen, Creep, PrandtlIshlinskii
from microrad.mirror.model import Mirror
from microrad.mirror.reading import read_mirror
from microrad.mission.file import MissionError, load_mirror, load_mission
from microrad.mission.tables.mirror import PrandtlIshlinskiiTable
from places import TESTS
from shipped import SHIPPED, edited

STEP = 20e-6
PRINTED = BoucWen(0.089e-3, -2.96e-7, -0.048e-3, 4.7e-4, 38.421, 34.635, 3770.0, 6.0)  # section 3.3 of the paper
ADMISSIBLE = replace(PRINTED, epsilon_rad_v=-0.022e-3, alpha_1_v=2.4, beta_1_v=0.6)
RISING = replace(ADMISSIBLE, epsilon_rad_v=0.03e-3)  # the drive term helps: no wrong way at all
PLAYS = PrandtlIshlinskii((0.0, 0.4, 1.5), (0.06e-3, 0.02e-3, 0.009e-3))
WIDENING = replace(PLAYS, widening_s=1e-4, rate_limit_v_s=3000.0)
POWERED = replace(ADMISSIBLE, gamma_1_v=0.5, eta_1_v=-0.7, exponent=2.0)
CREEP = Creep((0.004e-3, 0.003e-3, -0.001e-3), (2e-4, 2e-3, 0.5))
one_femtoradian = 1e-15  # two routes through the same arithmetic
twenty_femtoradians = 2e-14  # agreement with an adaptive solver

RESONANCE_RAD_S, DAMPING = 2 * pi * 900, 0.3
RESONANT = (  # the same transfer function in modal form, for the package, and in companion form, for scipy
    lti.modal_from_polynomials((RESONANCE_RAD_S**2,), (1.0, 2 * DAMPING * RESONANCE_RAD_S, RESONANCE_RAD_S**2)),
    (
        np.array([[0.0, 1.0], [-(RESONANCE_RAD_S**2), -2 * DAMPING * RESONANCE_RAD_S]]),
        np.array([[0.0], [RESONANCE_RAD_S**2]]),
        np.array([[1.0, 0.0]]),
        np.zeros((1, 1)),
    ),
)


@pytest.fixture(scope="module")
def table():
    return load_mission(SHIPPED).mission.mirror


def run(m, drive, step_s=STEP):
    """Output and number of clamped steps of the compiled plant, from rest."""
    plant = mirror.discretise(m, step_s)
    state = mirror.at_rest(plant)
    drive = np.ascontiguousarray(np.reshape(drive, (len(drive), -1)))
    output, bank = np.empty((len(drive), m.axes)), np.empty((len(drive), len(state.bank)))
    kernels.open_loop(plant, state, drive, output, bank)
    return output, state.clamped


def zigzag(seed, samples=120, scale=1.0):
    """A drive in volts of random slopes from zero, up to 5000 V/s at 20 µs."""
    rng = np.random.default_rng(seed)
    slopes = np.repeat(rng.uniform(-0.1, 0.1, samples // 6 + 1), 6)[: samples - 1]
    return scale * np.concatenate([[0.0], np.cumsum(slopes)])


# ------------------------------------------------------------------------------------------------ compositions


def by_hand(composition, model, drive):
    """Output of one axis: the bank by an adaptive solver or by its definition, the linear part by scipy."""

    def linear(signal):
        return lsim(RESONANT[1], signal, STEP * np.arange(len(signal)), interp=True)[1]

    if isinstance(model, PrandtlIshlinskii):
        rest = [0.0] * len(model.thresholds_v)
        states, _ = oracles.widening_play_response(
            drive, STEP, model.thresholds_v, model.widening_s, model.rate_limit_v_s, rest
        )
        whole = states @ np.array(model.weights_rad_v)
        first = model.weights_rad_v[0] * states[:, 0]
        return {
            "static": lambda: whole,
            "cascade": lambda: linear(whole),
            "additive": lambda: linear(first) + whole - first,
        }[composition]()
    whole, h, _ = oracles.bouc_wen_response(drive, STEP, oracles.BoucWen(*astuple(model)))
    return {
        "static": lambda: whole,
        "cascade": lambda: linear(whole),
        "additive": lambda: linear(whole - h) + h,
    }[composition]()


@pytest.mark.promise("mirror-file-11", "mirror-file-16", "mirror-file-19")
@pytest.mark.promise("decisions-1")
@pytest.mark.promise("hysteresis-1", "hysteresis-2", "hysteresis-19")
@pytest.mark.parametrize(
    ("composition", "model"),
    [
        ("static", PRINTED),
        ("cascade", PRINTED),
        ("additive", PRINTED),
        ("additive", ADMISSIBLE),
        ("additive", POWERED),
        ("static", PLAYS),
        ("cascade", PLAYS),
        ("additive", PLAYS),
        ("cascade", WIDENING),
        ("additive", WIDENING),
    ],
    ids=[
        "static",
        "cascade",
        "additive",
        "additive, admissible",
        "additive, exponent 2, asymmetric",
        "static plays",
        "cascade of plays",
        "additive plays",
        "cascade of widening plays",
        "additive widening plays",
    ],
)
def test_a_composition_is_its_block_diagram(composition, model):
    drive = zigzag(3)
    m = mirror.assemble("axis", composition, None if composition == "static" else RESONANT[0], model)
    output, _ = run(m, drive)
    expected = by_hand(composition, model, drive)
    error = np.max(np.abs(output[:, 0] - expected))
    print(f"within {error:.1e} rad of the block diagram, output up to {np.max(np.abs(expected)):.1e} rad")
    assert error < twenty_femtoradians
    assert np.max(np.abs(expected)) > 10e-6


@pytest.mark.promise("mirror-file-11", "mirror-file-22")
@pytest.mark.promise("hysteresis-16")
@pytest.mark.parametrize("composition", ["static", "cascade", "additive"])
@pytest.mark.parametrize("model", [PRINTED, WIDENING], ids=["Bouc-Wen", "widening plays"])
def test_creep_is_added_to_every_composition(composition, model):
    """The drive behind each lag, by scipy, on top of the mirror without creep."""
    drive = zigzag(3)
    system = None if composition == "static" else RESONANT[0]
    m = mirror.assemble("axis", composition, system, model, CREEP)
    with_creep, clamped = run(m, drive)
    without, clamped_without = run(mirror.assemble("axis", composition, system, model), drive)
    time = STEP * np.arange(len(drive))
    crept = sum(
        lsim(([-1 / tau], [1 / tau], [weight], [0.0]), drive, time, interp=True)[1]
        for weight, tau in zip(CREEP.weights_rad_v, CREEP.time_constants_s, strict=True)
    )
    assert_allclose(with_creep[:, 0], without[:, 0] + crept, rtol=0, atol=one_femtoradian)
    assert np.max(np.abs(crept)) > 1e-7
    assert_array_equal(clamped, clamped_without)
    assert clamped.sum() > 0
    assert m.inverse_creep == (CREEP,)


def test_creep_follows_the_convention_of_the_angle(tmp_path):
    """Line of sight: model and creep are doubled alike, so the whole output is."""
    table = '[mirror.creep]\ntime_constants = ["0.1 s", "1 s"]\nweights = ["2 urad/V", "1 urad/V"]\n\n[amplifier]\n'
    m = edited(tmp_path, ("[amplifier]\n", table)).mirror
    assert mirror.creep_model(m) == Creep((2e-6, 1e-6), (0.1, 1.0))
    drive = zigzag(3)
    once, twice = (
        run(mirror.from_mission(m, hysteresis.scaled(PRINTED, times), times=times), drive)[0] for times in (1.0, 2.0)
    )
    assert_allclose(twice, 2 * once, rtol=0, atol=one_femtoradian)
    assert_array_equal(mirror.from_mission(m, PRINTED, times=2.0).C[0, -2:], [4e-6, 2e-6])


def test_slow_lags_are_kept_in_the_linear_loop():
    """At rest a lag adds its whole weight, at a frequency far above 1 / tau none of it."""
    m = mirror.assemble("axis", "cascade", RESONANT[0], PRINTED, CREEP)
    loop = m.linear_loop
    slow, fast = (float(np.abs(lti.frequency_response(loop, np.array([f]))[0, 0, 0])) for f in (1e-6, 60.0))
    assert_allclose(slow, 0.089e-3 + sum(CREEP.weights_rad_v), rtol=1e-6)
    assert_allclose(fast, 0.089e-3 + CREEP.weights_rad_v[0], rtol=0.03)


def test_the_compositions_differ():
    drive = zigzag(3)
    outputs = [
        run(mirror.assemble("axis", c, RESONANT[0], PRINTED), drive)[0] for c in ("static", "cascade", "additive")
    ]
    for i, j in ((0, 1), (0, 2), (1, 2)):
        assert np.max(np.abs(outputs[i] - outputs[j])) > 1e-6


@pytest.mark.promise("mirror-file-11")
@pytest.mark.parametrize("composition", ["cascade", "additive"])
def test_a_composition_without_its_linear_part_is_refused(composition):
    with pytest.raises(ValueError, match=f'composition "{composition}" needs a linear part.*"static"'):
        mirror.assemble("axis", composition, None, PRINTED)


def test_a_mission_gives_its_composition_or_the_one_asked_for(table):
    given, other = mirror.from_mission(table, PRINTED), mirror.from_mission(table, PRINTED, "additive")
    assert given.name == "Core Tomorrow piezo fast steering mirror"
    assert (len(given.bouc_wen), len(other.bouc_wen)) == (1, 2)
    assert not np.any(given.K)
    assert_array_equal(other.K, [[0.0, 1.0]])
    assert mirror.from_mission(table, PRINTED, "static").A.size == 0


@pytest.mark.promise("mirror-file-10", "mirror-file-14")
@pytest.mark.promise("hysteresis-20")
@pytest.mark.parametrize("freq_hz", [1.0, 2.0, 100.0])
def test_the_linear_part_is_one_where_it_is_normalised(tmp_path, freq_hz):
    table = edited(tmp_path, ('normalise_at = "2 Hz"', f'normalise_at = "{freq_hz} Hz"')).mirror
    system, magnitude = mirror.linear_part(table.linear)
    at = np.array([freq_hz])
    assert_allclose(np.abs(lti.frequency_response(system, at)), 1.0, rtol=1e-14)
    assert 0.08022 * 0.9999 < magnitude < 0.08315 * 1.0001
    raw = np.abs(np.polyval(table.linear.numerator, 2j * pi * at) / np.polyval(table.linear.denominator, 2j * pi * at))
    assert_allclose(magnitude, raw, rtol=1e-10)
    whole = mirror.from_mission(table, PRINTED).linear_loop
    assert_allclose(np.abs(lti.frequency_response(whole, at)), PRINTED.d1_rad_v, rtol=1e-14)


# ------------------------------------------------------------------------------------------------ several axes


def stiffening(weight=0.4):
    """An oscillator with play operators fed back into its stiffness: q = F x, two elements, one actuator."""
    w = 2 * pi * 400
    return Mirror(
        name="stiffening",
        A=np.array([[0.0, w], [-w, -0.2 * w]]),
        B=np.array([[0.0], [0.05e-3 * w]]),
        E=np.array([[0.0, 0.0], [-w, -w]]),
        F=np.array([[1.0, 0.0], [1.0, 0.0]]),
        G=np.zeros((2, 1)),
        C=np.array([[1.0, 0.0]]),
        D=np.zeros((1, 1)),
        K=np.zeros((1, 2)),
        bouc_wen=(),
        plays=(PrandtlIshlinskii((20e-6, 40e-6), (weight / 2, weight / 2)), PrandtlIshlinskii((60e-6,), (weight / 2,))),
        inverse=(PrandtlIshlinskii((0.0,), (0.05e-3,)),),
    )


def test_mirrors_side_by_side_run_as_they_run_apart():
    """Plays before Bouc-Wen on purpose: the combined bank has to be put into the kernel's order."""
    parts = [
        mirror.assemble("plays", "cascade", RESONANT[0], WIDENING),
        mirror.assemble("printed", "additive", RESONANT[0], PRINTED),
        stiffening(),
        mirror.assemble("static", "static", None, replace(ADMISSIBLE, gamma_1_v=0.5, eta_1_v=-0.3), CREEP),
    ]
    both = mirror.combine(*parts)
    assert (both.actuators, both.axes) == (4, 4)
    assert both.name == "plays + printed + stiffening + static"
    drives = np.column_stack([zigzag(seed, 400, scale=5.0) for seed in (21, 22, 23, 24)])
    together, clamped = run(both, drives)
    apart = [run(part, drives[:, j]) for j, part in enumerate(parts)]
    for j, (alone, _) in enumerate(apart):
        assert_allclose(together[:, j], alone[:, 0], rtol=0, atol=one_femtoradian)
        assert np.ptp(alone) > 10e-6
    bouc_wen_first = [*(count[: len(m.bouc_wen)] for m, (_, count) in zip(parts, apart, strict=True))]
    then_plays = [*(count[len(m.bouc_wen) :] for m, (_, count) in zip(parts, apart, strict=True))]
    assert_array_equal(clamped, np.concatenate(bouc_wen_first + then_plays))
    assert then_plays[0] > 0
    assert clamped.sum() > 0


def test_the_order_of_a_matrix_in_memory_compiles_no_other_loop():
    """A loop takes seconds to compile, and once more for each type of its arrays."""
    plays, printed = (mirror.assemble("", "cascade", RESONANT[0], model) for model in (PLAYS, PRINTED))
    m = mirror.combine(plays, printed)
    turned = replace(m, **{key: np.asfortranarray(getattr(m, key)) for key in "ABCDEFGK"})
    assert not turned.K.flags.c_contiguous
    plants = [mirror.discretise(each, STEP) for each in (m, turned)]
    assert numba.typeof(plants[0]) == numba.typeof(plants[1]) != numba.typeof(plants[0]._replace(K=turned.K))


def test_two_axes_track_in_one_loop_as_in_two():
    """Different mirrors, controllers, inverses and references on the two axes of one kernel call."""
    timing = control.Timing(2 * STEP, 2, 1)
    drive = control.Drive(-4.0, 4.0, 5e3, 2000.0, 0.3e-3, 0.03e-6)
    parts = [
        mirror.assemble(
            "plays", "cascade", RESONANT[0], replace(WIDENING, rate_limit_v_s=600.0), Creep((0.002e-3,), (0.01,))
        ),
        mirror.assemble("printed", "cascade", RESONANT[0], PRINTED),
    ]
    pids = [control.pid(control.Gains(1e3, ki, 1e-2, 1e-4), timing.period_s) for ki in (16e6, 9e6)]
    references = [4e-4 * np.sin(2 * pi * f * timing.period_s * np.arange(3000)) for f in (30.0, 45.0)]
    both = mirror.combine(*parts)
    setup = simulate.Setup(drive, timing, side_by_side(*pids))
    every = slice(None)
    together = simulate.track("both", both, setup, control.inverse(both), np.column_stack(references), every)
    counts = []
    for j, (part, pid, reference) in enumerate(zip(parts, pids, references, strict=True)):
        alone = simulate.track(
            "one", part, simulate.Setup(drive, timing, pid), control.inverse(part), reference[:, None], every
        )
        assert_allclose(together.output_rad[:, j], alone.output_rad[:, 0], rtol=0, atol=one_femtoradian)
        assert_array_equal(together.command_v[:, j], alone.command_v[:, 0])
        counts.append(alone.counts)
    assert together.counts.clamped == sum(c.clamped for c in counts) > 0
    assert together.counts.inverse_clamped == sum(c.inverse_clamped for c in counts) > 0
    assert together.counts.saturated == sum(c.saturated for c in counts) > 0
    assert together.counts.slew_limited == sum(c.slew_limited for c in counts) > 0
    assert together.counts.alternating == sum(c.alternating for c in counts)


@pytest.mark.promise("hysteresis-22")
def test_a_loop_through_the_step_is_refused_with_a_step_that_is_accepted():
    m, coarse = stiffening(weight=3.0), 2e-3
    with pytest.raises(ValueError, match=r"'stiffening'.*no contraction at a step of 0\.002 s") as refusal:
        mirror.discretise(m, coarse)
    usable = float(re.search(r"at most (\S+) s", str(refusal.value)).group(1))
    print(f"{coarse} s is refused, {usable} s is named")
    assert coarse / 64 < usable < coarse
    assert mirror.contraction(m, coarse) >= 1.0
    assert mirror.contraction(m, usable) < 0.51 <= 1.02 * mirror.contraction(m, 2 * usable)
    mirror.discretise(m, usable)


@pytest.mark.promise("hysteresis-22")
def test_the_contraction_is_the_largest_row_sum_of_f_e1_and_the_steepest_slopes():
    m, step_s = stiffening(weight=3.0), 1e-4
    # E1: the share of a ramp of z from 0 to 1 over the step that x has at its end
    ramp = step_s * np.linspace(0.0, 1.0, 2001)
    ends = [
        lsim((m.A, m.E[:, [j]], np.eye(2), np.zeros((2, 1))), ramp / step_s, ramp, interp=True)[1][-1] for j in (0, 1)
    ]
    sums = np.abs(m.F @ np.array(ends).T) @ np.array([3.0, 1.5])
    assert_allclose(mirror.contraction(m, step_s), np.max(sums), rtol=1e-6)
    assert np.max(sums) > 0.01


def test_a_mirror_driven_by_its_input_alone_has_no_loop_through_the_step():
    assert mirror.contraction(mirror.assemble("axis", "cascade", RESONANT[0], PRINTED), 1.0) == 0.0


def test_the_linear_loop_of_a_fed_back_bank_is_its_response_without_thresholds():
    m = replace(stiffening(), plays=(PrandtlIshlinskii((0.0, 0.0), (0.3, 0.1)), PrandtlIshlinskii((0.0,), (0.2,))))
    loop = m.linear_loop
    drive = np.sin(2 * pi * 250 * 2e-6 * np.arange(4000))
    expected = lsim((loop.A, loop.B, loop.C, loop.D), drive, 2e-6 * np.arange(4000), interp=True)[1]
    output, _ = run(m, drive, 2e-6)
    share = np.max(np.abs(output[:, 0] - expected)) / np.ptp(expected)
    assert share < 1e-4
    without = lsim((m.A, m.B, m.C, m.D), drive, 2e-6 * np.arange(4000), interp=True)[1]
    assert np.max(np.abs(without - expected)) / np.ptp(expected) > 0.1


@pytest.mark.promise("choose-3")
def test_hysteresis_in_the_path_of_the_input_leaves_the_resonance_where_it_is_and_in_the_stiffness_does_not():
    """Fundamental of the answer to a sine, over that to a small one: behind plays it rises alike at all frequencies."""
    small, large = 0.02, 4.0

    def gain(m, amplitude, freq_hz):
        step_s = 1.0 / (freq_hz * 200)
        time = step_s * np.arange(20 * 200)
        output, _ = run(m, amplitude * np.sin(2 * pi * freq_hz * time), step_s)
        return abs(np.exp(-2j * pi * freq_hz * time[-2000:]) @ output[-2000:, 0]) / 1000 / amplitude

    def rises(m):
        return [gain(m, large, f) / gain(m, small, f) for f in (250.0, 500.0)]

    below, above = rises(mirror.assemble("axis", "cascade", RESONANT[0], PLAYS))
    assert below > 1.2 and abs(above / below - 1.0) < 0.01
    below, above = rises(stiffening())
    assert below < 0.8 and above > 1.2  # 400 Hz at rest: the resonance has risen, towards 473 Hz where all plays slide


# ------------------------------------------------------------------------------------------------ models


@pytest.mark.parametrize("model", [PRINTED, PLAYS], ids=["Bouc-Wen", "plays"])
def test_the_line_of_sight_moves_by_twice_the_mechanical_angle(model):
    drive = zigzag(8, 300)
    mechanical, optical = (
        run(mirror.assemble("axis", "static", None, hysteresis.scaled(model, hysteresis.LINE_OF_SIGHT[c])), drive)[0]
        for c in ("line-of-sight", "mechanical")
    )
    assert_allclose(optical, 2 * mechanical, rtol=1e-13, atol=one_femtoradian)
    assert hysteresis.slow_gain(hysteresis.scaled(model, 2.0)) == 2 * hysteresis.slow_gain(model)


@pytest.mark.parametrize("model", [PRINTED, PLAYS], ids=["Bouc-Wen", "plays"])
def test_gain_only_is_a_straight_line(model):
    drive = zigzag(9, 300)
    straight = hysteresis.gain_only(model)
    output, _ = run(mirror.assemble("axis", "static", None, straight), drive)
    slope = {PRINTED: 0.089e-3, PLAYS: 0.089e-3}[model]
    assert_allclose(output[:, 0], slope * drive, rtol=1e-13)
    assert hysteresis.slow_gain(straight) == pytest.approx(slope, rel=1e-14)


@pytest.mark.promise("mirror-file-7", "mirror-file-12")
def test_hysteresis_model_takes_limit_and_bias_from_the_mission(table):
    assert mirror.hysteresis_model(table, 3770.0, 6.0) == PRINTED
    compared = mirror.hysteresis_model(table.comparison, 100.0, 1.0)
    assert compared == replace(ADMISSIBLE, rate_limit_v_s=100.0, bias_v=1.0)


# ------------------------------------------------------------------------------------------------ reversals

LONG = 30.0  # volts: long enough for every branch below to settle


def after_a_reversal(model, rate_v_s, travel_v=1e-7, points=2):
    """(way back in volts, output since the reversal) behind a long ramp, at the same rate before and after."""
    ramp = np.linspace(0, LONG, 20_001)  # the exact step has no limit on its size
    before = kernels.bouc_wen_response(ramp, ramp[1] / rate_v_s, np.array(model.row), 0.0)
    back = LONG - np.linspace(0, travel_v, points)
    turned, _, _ = kernels.bouc_wen_response(
        back, travel_v / (points - 1) / rate_v_s, np.array(model.row), before[1][-1]
    )
    travelled = LONG - back
    # d2 u' is another matter: it steps at every reversal whatever the hysteresis does
    return travelled, turned


def numerical_slope(model, rate_v_s):
    model = replace(model, d2_s_v=0.0)
    travelled, output = after_a_reversal(model, rate_v_s)
    return -(output[1] - output[0]) / travelled[1]


@pytest.mark.promise("mirror-file-17")
@pytest.mark.promise("hysteresis-10", "sampled-loop-14")
@pytest.mark.parametrize("rate_v_s", [1e-3, 500.0, 3000.0, 9000.0])
@pytest.mark.parametrize("model", [PRINTED, ADMISSIBLE, RISING], ids=["printed", "admissible", "rising"])
def test_the_slope_after_a_reversal_is_the_numerical_one(model, rate_v_s):
    expected = numerical_slope(model, rate_v_s)
    formula = model.reversal_slope_rad_v(rate_v_s)
    print(f"{rate_v_s:g} V/s: {formula * 1e3:.4f} mrad/V, numerically {expected * 1e3:.4f}")
    assert_allclose(formula, expected, rtol=1e-4, atol=1e-9)


@pytest.mark.promise("hysteresis-10", "hysteresis-12")
def test_the_branch_settles_where_the_record_says():
    for model, sign in ((PRINTED, -1), (ADMISSIBLE, -1), (RISING, 1)):
        ramp = np.linspace(0, LONG, 20_001)
        _, h, _ = kernels.bouc_wen_response(ramp, 1e3, np.array(model.row), 0.0)
        assert_allclose(h[-1], sign * model.settled_rad, rtol=1e-9)
    assert_allclose(PRINTED.settled_rad, 12.7e-6, rtol=0.005)
    assert_allclose(ADMISSIBLE.settled_rad, 12.2e-6, rtol=0.005)


@pytest.mark.promise("gallery-3", "readme-21")
@pytest.mark.promise("hysteresis-12", "sampled-loop-14")
@pytest.mark.promise("hysteresis-12", "pointing-96", "sampled-loop-14")
def test_the_printed_mirror_first_moves_the_wrong_way():
    slope = PRINTED.reversal_slope_rad_v()
    assert_allclose(slope - PRINTED.d1_rad_v, -0.98e-3, rtol=0.02)
    assert_allclose(slope, -0.98e-3 + 0.089e-3, rtol=0.02)
    assert_allclose(PRINTED.wrong_way_rad, 9.2e-6, rtol=0.01)
    travelled, output = after_a_reversal(replace(PRINTED, d2_s_v=0.0), 1e-3, travel_v=0.5, points=50_001)
    furthest = int(np.argmax(output))
    assert_allclose(PRINTED.wrong_way_rad, output[furthest] - output[0], rtol=1e-6)
    assert_allclose(travelled[furthest], 33e-3, rtol=0.03)
    assert output[-1] < output[0]


def test_how_far_a_mirror_moves_the_wrong_way_when_its_drive_term_outweighs_its_gain():
    """|epsilon| > d1: the output turns only behind the zero of h."""
    model = replace(PRINTED, epsilon_rad_v=-0.2e-3, alpha_1_v=38.0, beta_1_v=30.0, d2_s_v=0.0)
    _, output = after_a_reversal(model, 1e-3, travel_v=3.0, points=50_001)
    assert_allclose(model.wrong_way_rad, np.max(output) - output[0], rtol=1e-4)


@pytest.mark.promise("readme-21")
@pytest.mark.promise("hysteresis-11")
@pytest.mark.parametrize("model", [ADMISSIBLE, RISING], ids=["admissible", "rising"])
def test_an_admissible_mirror_never_moves_the_wrong_way(model):
    assert model.reversal_slope_rad_v() > 0.0
    assert model.wrong_way_rad == 0.0
    _, output = after_a_reversal(replace(model, d2_s_v=0.0), 1e-3, travel_v=0.5, points=5001)
    assert np.all(np.diff(output) < 0)


def test_the_fastest_admissible_reversal():
    rate = ADMISSIBLE.admissible_rate_v_s
    assert_allclose(rate, 886, atol=1)
    assert numerical_slope(ADMISSIBLE, 0.99 * rate) > 1e-7
    assert numerical_slope(ADMISSIBLE, 1.01 * rate) < -1e-7
    assert abs(numerical_slope(ADMISSIBLE, rate)) < 1e-9


@pytest.mark.parametrize(
    ("model", "rate_v_s"),
    [(PRINTED, 0.0), (RISING, inf), (replace(ADMISSIBLE, delta_s_v=0.0), inf)],
    ids=["printed: none", "rising: any", "no growth with rate: any"],
)
def test_admissible_rates_at_the_ends(model, rate_v_s):
    assert model.admissible_rate_v_s == rate_v_s


@pytest.mark.promise("mirror-file-12")
def test_the_growth_of_the_slope_is_held_at_the_rate_limit():
    beyond = ADMISSIBLE.reversal_slope_rad_v(1e6)
    assert beyond == ADMISSIBLE.reversal_slope_rad_v(3770.0)
    fall = ADMISSIBLE.d1_rad_v - ADMISSIBLE.reversal_slope_rad_v()
    assert_allclose(ADMISSIBLE.d1_rad_v - beyond, fall * exp(4.7e-4 * 3770), rtol=1e-12)


# ------------------------------------------------------------------------------------------------ the summary

ONE_RESONANCE = (
    ("numerator = [1.979e11, 7.051e13, 2.973e13]", "numerator = [1e8]"),
    ("denominator = [1, 2.15e4, 3.737e8, 2.615e12, 8.489e14, 1.829e14]", "denominator = [1, 1e4, 1e8]"),
)
ADMISSIBLE_TABLE = (
    ('epsilon = "-0.048 mrad/V"', 'epsilon = "-0.022 mrad/V"'),
    ('alpha = "38.421 1/V"', 'alpha = "2.4 1/V"'),
    ('beta = "34.635 1/V"', 'beta = "0.6 1/V"'),
)


@pytest.mark.promise("readme-21")
@pytest.mark.promise("hysteresis-12")
def test_the_summary_warns_of_the_papers_mirror(table):
    summary = mirror_summary.summarise(table)
    reversal, pole, zero, gain = summary.warnings
    assert "not physical at reversals" in reversal
    assert "-0.885 mrad/V against d1 = 0.089 mrad/V" in reversal
    assert "9.2 µrad" in reversal
    assert pole.startswith("pole at 0.0343 Hz lies outside the excited band (1 to 5000 Hz)")
    assert zero.startswith("zero at 0.0672 Hz lies outside")
    assert gain.startswith("gain at DC 0.16255 is not the gain in the band, 0.079")
    assert_allclose([summary.dc_gain, summary.normalised_by], [0.16255, 0.08305], atol=5e-6)
    assert str(summary).split("\n") == [
        "Core Tomorrow piezo fast steering mirror: cascade, Bouc-Wen hysteresis",
        "  linear part divided by 0.08305, its magnitude at 2 Hz",
        "  gain at DC 0.16255, in the flat band from 1 to 254 Hz 0.07917 to 0.08315",
        "  pole at 2543 Hz, damping 0.357",
        "  pole at 1553 Hz, damping 1.000",
        "  pole at 54.22 Hz, damping 1.000",
        "  pole at 0.03431 Hz, damping 1.000",
        "  zero at 56.64 Hz, damping 1.000",
        "  zero at 0.06719 Hz, damping 1.000",
        "  rate in the hysteresis held at 3770 V/s; clamped samples are counted",
        *(f"  warning: {each}" for each in summary.warnings),
    ]
    assert reversal.endswith("so the modelled mirror first moves the wrong way, by 9.2 µrad on a slow drive")
    assert pole.endswith("(1 to 5000 Hz): drift fitted as dynamics")


def with_linear(table, **changed):
    """The mirror with another linear part, of roots where they are given."""
    if "poles_hz" in changed:
        none = {"zeros_hz": None, "zero_dampings": None}
        changed = {"numerator": None, "denominator": None, **none, **changed}
    return table.model_copy(update={"linear": table.linear.model_copy(update=changed)})


def about_the_linear_part(table, **changed):
    """The warnings of such a mirror about its linear part."""
    return mirror_summary.summarise(with_linear(table, **changed)).warnings[1:]


@pytest.mark.parametrize(
    ("pole_hz", "words"),
    [
        (0.5, ["pole at 0.5 Hz lies outside the excited band (1 to 4096 Hz): drift fitted as dynamics"]),
        (1.0, []),
        (4096.0, []),
        (8192.0, ["pole at 8190 Hz lies outside the excited band (1 to 4096 Hz): extrapolated"]),
    ],
)
def test_a_root_at_an_end_of_the_excited_band_lies_in_it(table, pole_hz, words):
    """Roots of powers of two, which 2 pi scales without rounding; the gain at DC is another matter."""
    found = about_the_linear_part(table, poles_hz=(pole_hz,), pole_dampings=(1.0,), excited_to_hz=4096.0)
    assert [each for each in found if not each.startswith("gain at DC")] == words


@pytest.mark.parametrize(("share", "warned"), [(0.88, True), (0.92, False), (1.08, False), (1.12, True)])
def test_a_gain_at_dc_of_a_tenth_below_the_band_is_warned_of_as_above_it(table, share, warned):
    """A zero beside a slow pole at 1 mHz: the gain at DC is that in the band times their ratio."""
    roots = {"poles_hz": (1e-3, 4e4), "pole_dampings": (1.0, 1.0)}
    made = with_linear(table, **roots, zeros_hz=(share * 1e-3,), zero_dampings=(1.0,))
    summary = mirror_summary.summarise(made)
    assert summary.dc_gain == pytest.approx(share, rel=1e-4)
    said = [each for each in summary.warnings if each.startswith("gain at DC")]
    assert [each[: each.index(",")] for each in said] == [
        f"gain at DC {summary.dc_gain:.5f} is not the gain in the band"
    ] * warned


@pytest.mark.parametrize(
    ("poles_hz", "damping", "band"),
    [
        ((2000.0,), 0.5, (1.0, 200.0)),
        ((5.0,), 0.5, (1.0, 1.0)),
        ((2000.0,), 1.0, (1.0, 5000.0)),
        ((8e4,), 0.1, (1.0, 5000.0)),
    ],
)
def test_the_flat_band_ends_at_a_tenth_of_the_lowest_resonance_and_within_what_was_excited(
    table, poles_hz, damping, band
):
    summary = mirror_summary.summarise(with_linear(table, poles_hz=poles_hz, pole_dampings=(damping,)))
    assert_allclose(summary.flat_band_hz, band, rtol=1e-12)


def test_a_zero_at_rest_is_real(table):
    """A washout passes no constant: its zero has no size to take a damping of."""
    summary = mirror_summary.summarise(with_linear(table, numerator=(1.0, 0.0), denominator=(1.0, 1e4, 1e8)))
    assert "\n  zero at 0 Hz, damping 1.000\n" in str(summary)
    assert summary.dc_gain == pytest.approx(0.0, abs=1e-12)


def test_the_summary_of_plays_says_what_creep_adds(table):
    """15 % of 80 µrad/V in the end."""
    plays = PrandtlIshlinskii((0.0, 1.0), (60e-6, 20e-6))
    creep = Creep((8e-6, 3e-6, 1e-6), (0.1, 1.0, 25.0))
    text = str(replace(mirror_summary.summarise(table), model=plays, creep=creep))
    assert text.startswith("Core Tomorrow piezo fast steering mirror: cascade, Prandtl-Ishlinskii hysteresis\n")
    assert "\n  creep adds 15 % of the gain in the long run, with lags from 0.1 s to 25 s\n" in text
    assert "creep" not in str(mirror_summary.summarise(table))


def test_a_slope_that_only_just_stays_is_not_warned_of(table):
    """Both decays are 1 per volt: half of the slope at rest is 8 of 16, and nothing is left of it there."""
    of = {"d1_rad_v": 16e-6, "epsilon_rad_v": -8e-6, "alpha_1_v": 1.0, "beta_1_v": 0.0}

    def warned(rate_limit_v_s, **changed):
        bouc_wen = table.bouc_wen.model_copy(update=of | changed)
        made = table.model_copy(update={"bouc_wen": bouc_wen, "rate_limit_v_s": rate_limit_v_s, "linear": None})
        return [each for each in mirror_summary.summarise(made).warnings if "reversal" in each]

    assert warned(100.0, delta_s_v=0.0) == []
    (wrong,) = warned(100.0, delta_s_v=0.0, epsilon_rad_v=-9e-6)
    assert wrong.startswith(
        "not physical at reversals: the local slope falls to -0.002 mrad/V against d1 = 0.016 mrad/V"
    )
    limit = hysteresis.BoucWen(16e-6, 0.0, -4e-6, 1e-3, 1.0, 0.0).admissible_rate_v_s
    assert 693.0 < limit < 694.0
    assert warned(limit, delta_s_v=1e-3, epsilon_rad_v=-4e-6) == []
    assert warned(limit + 1e-6, delta_s_v=1e-3, epsilon_rad_v=-4e-6) == [
        "the slope after a reversal stays positive only up to 693 V/s before the reversal"
    ]


def test_the_summary_warns_of_nothing_when_there_is_nothing(tmp_path):
    slow = ('rate_limit = "3770 V/s"', 'rate_limit = "800 V/s"')
    summary = mirror_summary.summarise(edited(tmp_path, *ONE_RESONANCE, *ADMISSIBLE_TABLE, slow).mirror)
    assert summary.warnings == ()
    assert "warning" not in str(summary)
    assert_allclose(summary.dc_gain, 1.0, rtol=1e-12)
    (root,) = summary.roots
    assert (root.kind, root.in_band) == ("pole", True)
    assert_allclose([root.frequency_hz, root.damping], [1e4 / (2 * pi), 0.5], rtol=1e-12)


def test_the_summary_says_up_to_which_rate_a_mirror_is_admissible(tmp_path):
    (warning,) = mirror_summary.summarise(edited(tmp_path, *ONE_RESONANCE, *ADMISSIBLE_TABLE).mirror).warnings
    assert re.search("stays positive only up to 88[67] V/s", warning)


def test_the_summary_of_a_static_mirror_has_no_linear_part(tmp_path):
    text = SHIPPED.read_text()
    linear = text[text.index("[mirror.linear]") : text.index("[mirror.bouc_wen]")]
    m = edited(tmp_path, (linear, ""), ('composition = "cascade"', 'composition = "static"'))
    summary = mirror_summary.summarise(m.mirror)
    assert summary.roots == ()
    reversals, dynamics = summary.warnings
    assert reversals.startswith("not physical at reversals")
    assert dynamics == mirror_summary.unknown_dynamics(m.mirror) != ""
    assert "gain at DC" not in str(summary)


@pytest.mark.parametrize(
    ("model", "says"),
    [
        (PrandtlIshlinskii((0.0, 1.0), (2e-5, 1e-5)), "valid to 250 V/s"),
        (PrandtlIshlinskii((0.0, 1.0), (2e-5, 1e-5), 1e-4, 250.0), "rate in the hysteresis held at 250 V/s"),
        (PRINTED, "rate in the hysteresis held at 250 V/s"),
    ],
)
def test_a_model_that_knows_no_rate_is_valid_to_the_limit_and_the_others_are_held_there(table, model, says):
    summary = replace(mirror_summary.summarise(table), model=model, rate_limit_v_s=250.0)
    assert f"\n  {says}" in str(summary)


@pytest.mark.parametrize(("damps", "unstable"), [(1e2, False), (-1e2, True)])
def test_a_pole_is_called_unstable_where_it_grows(table, damps, unstable):
    changed = {"numerator": (1e8,), "denominator": (1.0, damps, 1e8)}
    made = table.model_copy(update={"linear": table.linear.model_copy(update=changed)})
    warnings = [each for each in mirror_summary.summarise(made).warnings if "unstable" in each]
    assert warnings == ["unstable pole at 1.59e+03 Hz"] * unstable


@pytest.mark.parametrize(
    ("model", "counts"),
    [
        (PLAYS, [1, 2]),
        (PrandtlIshlinskii((0.0,), (0.06e-3,)), [1]),
        (PrandtlIshlinskii((0.4, 1.5), (0.06e-3, 0.02e-3)), [2]),
    ],
)
def test_plays_are_split_only_into_a_gain_and_what_is_left(model, counts):
    """Behind an additive linear part: what has no play at 0, or no other, stays one operator."""
    whole = mirror.assemble("axis", "additive", RESONANT[0], model)
    assert [len(each.thresholds_v) for each in whole.plays] == counts
    assert [w for each in whole.plays for w in each.weights_rad_v] == list(model.weights_rad_v)
    assert whole.K[0].tolist() == [0.0, 1.0][: len(counts)]
    assert not mirror.assemble("axis", "additive", RESONANT[0], ADMISSIBLE).bouc_wen[0].epsilon_rad_v


def test_one_drive_of_a_mirror_of_two_outputs_is_answered_by_both():
    system = lti.StateSpace(np.diag([-100.0, -300.0]), np.ones((2, 1)), np.diag([100.0, 600.0]), np.zeros((2, 1)))
    two = Mirror.of_system(system)
    drive = zigzag(4)
    found = two.response(drive, STEP)
    assert found.shape == (drive.size, 2)
    assert_array_equal(found, two.response(drive[:, None], STEP))
    for j in range(2):
        one = lti.StateSpace(system.A, system.B, system.C[j : j + 1], np.zeros((1, 1)))
        assert Mirror.of_system(one).response(drive, STEP).shape == drive.shape
        assert Mirror.of_system(one).response(drive[:, None], STEP).shape == (drive.size, 1)
        assert_allclose(Mirror.of_system(one).response(drive, STEP), found[:, j], rtol=1e-12, atol=1e-18)


def test_a_step_that_is_too_long_for_what_is_fed_back_names_one_that_keeps_half_of_an_error():
    with pytest.raises(
        ValueError, match=r"^mirror 'stiffening': .* no contraction at a step of 0\.01 s; use"
    ) as caught:
        mirror.discretise(stiffening(20.0), 0.01)
    named = float(re.search(r"at most (\S+) s, or", str(caught.value))[1])
    assert mirror.contraction(stiffening(20.0), named) < 0.5 <= mirror.contraction(stiffening(20.0), 2.01 * named)
    mirror.discretise(stiffening(20.0), named)


@pytest.mark.parametrize("bottom", [[1.0, 2.0, 3.0], 4.0])
def test_a_plain_number_is_a_polynomial_of_one_coefficient(bottom):
    one, listed = (Mirror.of(50e-6, top, bottom) for top in (2.0, [2.0]))
    for key in "ABCD":
        assert_allclose(getattr(one, key), getattr(listed, key), rtol=0.0)


@pytest.mark.parametrize(("widening_s", "limit_v_s"), [(0.0, inf), (1e-4, 300.0)])
def test_plays_are_held_at_the_rate_limit_only_where_they_widen(table, widening_s, limit_v_s):
    plays = PrandtlIshlinskiiTable(
        thresholds=["0 V", "1 V"], weights=["2 urad/V", "1 urad/V"], widening=f"{widening_s} s"
    )
    made = table.model_copy(update={"bouc_wen": None, "prandtl_ishlinskii": plays})
    found = mirror.hysteresis_model(made, 300.0, 6.0)
    assert (found.widening_s, found.rate_limit_v_s) == (widening_s, limit_v_s)


@pytest.mark.promise("mirror-file-17")
@pytest.mark.parametrize("beta", [-2.0, 0.0, 2.0])
@pytest.mark.parametrize("epsilon", [-0.02e-3, 0.02e-3])
def test_the_settled_size_and_the_slope_behind_a_reversal_follow_both_signs(epsilon, beta):
    model = hysteresis.BoucWen(0.089e-3, 0.0, epsilon, 0.0, 5.0, beta)
    drive = np.concatenate([np.linspace(0.0, 20.0, 40_001), [20.0 - 1e-6]])
    output, h, _ = kernels.bouc_wen_response(drive, 1.0, np.array(model.row), 0.0)
    assert_allclose(abs(h[-2]), model.settled_rad, rtol=1e-9)
    assert_allclose((output[-2] - output[-1]) / 1e-6, model.reversal_slope_rad_v(), rtol=1e-4)


@pytest.mark.promise("mirror-file-19")
def test_a_softer_mirror_for_small_drives():
    """Two plays, by hand: 0.1 of the drive, and 0.3 of what is beyond 2 V."""
    model = hysteresis.PrandtlIshlinskii((0.0, 2.0), (0.1e-3, 0.3e-3))
    assert hysteresis.output_amplitude(model, 1.0) == pytest.approx(0.1e-3)
    assert hysteresis.output_amplitude(model, 4.0) == pytest.approx(1.0e-3)
    assert hysteresis.secant_gain(model, 0.1e-3) == pytest.approx(0.1e-3)
    assert hysteresis.secant_gain(model, 1.0e-3) == pytest.approx(0.25e-3)
    assert hysteresis.secant_gain(model, np.inf) == hysteresis.slow_gain(model) == pytest.approx(0.4e-3)
    assert hysteresis.gain_only(model, 1.0e-3).d1_rad_v == pytest.approx(0.25e-3)
    # the kernel's own settled response to a sine of 4 V has that amplitude
    turns = 4.0 * np.sin(2 * np.pi * np.arange(3000) / 1000)
    states = kernels.play_response(turns, np.array(model.thresholds_v), np.zeros(2))
    assert np.max((states @ np.array(model.weights_rad_v))[1000:]) == pytest.approx(1.0e-3, rel=1e-9)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((inf, [1.0], [1e-8, 1e-4, 1.0]), "d1_rad_v of the Bouc-Wen model is inf"),
        ((5e-5, [1.0], [1e-320, 1e-4, 1.0]), r"begins with .*, nothing beside the others"),
        ((5e-5, [1.0], [1e-8, nan, 1.0]), "rows of finite coefficients"),
        ((5e-5, [1j], [1e-8, 1e-4, 1.0]), "numerator of mirror 'mirror': no array of real numbers"),
        ((5e-5, [], [1e-8, 1e-4, 1.0]), "rows of finite coefficients"),
        (
            (5e-5, [1.0], [0.0, 1.0]),
            "a numerator of 1 and a denominator of 2 coefficients: give one that is strictly proper",
        ),
        ((5e-5, [1.0], [1.0, 0.0]), "a denominator of 2 coefficients: give one that is strictly proper and stable"),
        ((5e-5, [1.0, 0.0], [1.0, 1e4, 1e8]), "a numerator of 2 and .* and that passes a constant"),
        ((5e-5, [1.0, 1.0, 1.0], [1.0, 1.0]), "a numerator of 3 and a denominator of 2 coefficients: give one that"),
        ((5e-5, [1.0, 2.0], [1.0, 1.0]), "a numerator of 2 and a denominator of 2 coefficients: give one that"),
        ((5e-5, [1.0, 2.0], [7.0]), "a numerator of 2 and a denominator of 1 coefficients: give one that"),
        ((5e-5, [0.0], [7.0]), "a numerator of 1 and a denominator of 1 coefficients: give one that"),
        ((5e-5, [1.0], [0.0]), "a numerator of 1 and a denominator of 1 coefficients: give one that"),
        ((5e-5, [0.0, 0.0], [1.0, 1.0]), "a numerator of 2 .* and that passes a constant"),
        ((5e-5, [[1.0]], [1e-8, 1e-4, 1.0]), "rows of finite coefficients"),
    ],
)
def test_a_mirror_of_what_makes_no_numbers_is_refused(arguments, message):
    with pytest.raises(ValueError, match=message):
        Mirror.of(*arguments)


def test_a_mirror_refuses_drives_steps_and_frequencies_that_are_none():
    found = Mirror.of(5e-5, [1.0], [1 / 6000**2, 0.8 / 6000, 1.0])
    for call in (
        lambda: found.response([1.0, 2.0], nan),
        lambda: found.response([1.0, 2.0], 0.5 * LEAST),
        lambda: found.response([1.0, 2.0], 2.0 * MOST),
        lambda: found.response([1.0, 2.0j], 1e-4),
        lambda: found.frequency_response([1.0, nan]),
        lambda: found.frequency_response([[1.0, 2.0]]),
    ):
        with pytest.raises(ValueError, match="give"):
            call()
    straight = Mirror.of(5e-5)
    for step_s in (LEAST, MOST):
        assert_allclose(straight.response([1.0, 2.0], step_s), [5e-5, 1e-4])


@pytest.mark.parametrize("real", [0.0, 1.0])
def test_a_linear_system_without_decay_is_refused(real):
    system = lti.StateSpace(np.array([[real]]), np.ones((1, 1)), np.ones((1, 1)), np.zeros((1, 1)))
    with pytest.raises(
        ValueError, match="linear system of mirror 'mine' is not stable: every pole has to have a decay"
    ):
        Mirror.of_system(system, "mine")
    through = lti.StateSpace(np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), np.array([[3e-5]]))
    assert_allclose(Mirror.of_system(through).response([2.0], 1.0), [6e-5])


# ------------------------------------------------------------------------------------ matrices of numbers all unlike
LAGGING = lti.StateSpace(
    np.array([[-5.0, 40.0], [-40.0, -5.0]]), np.array([[2.0], [-3.0]]), np.array([[7.0, 11.0]]), np.zeros((1, 1))
)
SLOW = Creep((1e-6, -2e-6), (0.5, 4.0))


@pytest.mark.parametrize(
    ("composition", "E", "K"),
    [
        ("cascade", [[2.0], [-3.0], [0.0], [0.0]], [[0.0]]),
        ("additive", [[2.0, 0.0], [-3.0, 0.0], [0.0, 0.0], [0.0, 0.0]], [[0.0, 1.0]]),
    ],
)
@pytest.mark.parametrize("model", [PRINTED, PLAYS], ids=["bouc-wen", "plays"])
def test_each_composition_has_its_matrices_with_creep_behind_them(composition, E, K, model):
    m = mirror.assemble("m", composition, LAGGING, model, SLOW)
    assert m.A.tolist() == [[-5.0, 40.0, 0, 0], [-40.0, -5.0, 0, 0], [0, 0, -2.0, 0], [0, 0, 0, -0.25]]
    assert m.B.tolist() == [[0.0], [0.0], [2.0], [0.25]]
    assert m.C.tolist() == [[7.0, 11.0, 1e-6, -2e-6]]
    assert (m.E.tolist(), m.K.tolist(), m.D.tolist()) == (E, K, [[0.0]])
    assert m.F.tolist() == [[0.0] * 4] * len(K[0]) and m.G.tolist() == [[1.0]] * len(K[0])
    assert (m.name, m.inverse, m.inverse_creep) == ("m", (model,), (SLOW,))
    parts = {
        ("cascade", PRINTED): (PRINTED,),
        ("cascade", PLAYS): (PLAYS,),
        ("additive", PRINTED): (replace(PRINTED, epsilon_rad_v=0.0), replace(PRINTED, d1_rad_v=0.0)),
        ("additive", PLAYS): (
            PrandtlIshlinskii((0.0,), (0.06e-3,)),
            PrandtlIshlinskii((0.4, 1.5), (0.02e-3, 0.009e-3)),
        ),
    }
    assert m.bank == parts[composition, model]


def test_plays_that_begin_above_0_have_no_gain_to_split_off():
    late = PrandtlIshlinskii((0.2, 0.5), (3e-5, 1e-5))
    m = mirror.assemble("late", "additive", LAGGING, late, SLOW)
    assert m.bank == (late,)
    assert (m.E.tolist(), m.K.tolist()) == ([[2.0], [-3.0], [0.0], [0.0]], [[0.0]])
    static = mirror.assemble("late", "static", LAGGING, late, SLOW)
    assert (static.A.tolist(), static.C.tolist()) == ([[-2.0, 0.0], [0.0, -0.25]], [[1e-6, -2e-6]])
    assert (static.E.tolist(), static.K.tolist()) == ([[0.0], [0.0]], [[1.0]])


def unlike():
    """Two drives, two outputs, three elements that are fed back and straight ways through."""
    return Mirror(
        name="unlike",
        A=np.array([[-2.0, 0.0], [0.0, -3.0]]),
        B=np.array([[1.0, 2.0], [3.0, 5.0]]),
        E=np.array([[0.1, 0.2, 0.3], [0.4, 0.5, 0.7]]),
        F=np.array([[0.01, 0.02], [0.03, 0.05], [0.07, 0.11]]),
        G=np.array([[1.1, 1.3], [1.7, 1.9], [2.3, 2.9]]),
        C=np.array([[13.0, 17.0], [19.0, 23.0]]),
        D=np.array([[29.0, 31.0], [37.0, 41.0]]),
        K=np.array([[0.6, 0.8, 0.9], [1.2, 1.4, 1.6]]),
        bouc_wen=(BoucWen(0.5, 0.0, -0.1, 0.0, 1.0, 0.2),),
        plays=(PrandtlIshlinskii((0.0, 1.0), (0.3, 0.1)), PrandtlIshlinskii((0.0,), (0.7,))),
        inverse=(),
    )


def test_gains_in_place_of_elements_pass_from_each_drive_and_state_to_each_state_and_output():
    m, gains = unlike(), np.diag([0.5, 0.4, 0.7])
    found = m.linear_loop
    assert_allclose(found.A, m.A + m.E @ gains @ m.F, rtol=1e-12)
    assert_allclose(found.B, m.B + m.E @ gains @ m.G, rtol=1e-12)
    assert_allclose(found.C, m.C + m.K @ gains @ m.F, rtol=1e-12)
    assert_allclose(found.D, m.D + m.K @ gains @ m.G, rtol=1e-12)
    at = 2j * pi * 3.0
    seen = found.C @ np.linalg.solve(at * np.eye(2) - found.A, found.B) + found.D
    assert_allclose(m.frequency_response([0.7, 3.0])[1], seen, rtol=1e-12)
    straight = mirror.linearised(m, [0.5, 0.4, 0.7])
    for name in "ABCD":
        assert_allclose(getattr(straight, name), getattr(found, name), rtol=1e-15)
    assert [getattr(straight, name).shape for name in "EFGK"] == [(2, 0), (0, 2), (0, 2), (2, 0)]
    assert (straight.name, straight.bank, straight.actuators, straight.axes) == ("unlike", (), 2, 2)


def test_mirrors_of_other_sizes_side_by_side_keep_their_elements_in_order():
    """Plays alone, then three elements with two drives, then one of Bouc and Wen alone."""
    first = mirror.assemble("first", "static", None, PLAYS, SLOW)
    last = mirror.assemble("last", "cascade", LAGGING, PRINTED)
    both = mirror.combine(first, unlike(), last)
    assert both.name == "first + unlike + last"
    assert both.bank == (*unlike().bouc_wen, PRINTED, PLAYS, *unlike().plays)
    assert both.inverse == (PLAYS, PRINTED) and both.inverse_creep == (SLOW, hysteresis.NO_CREEP)
    assert (both.A.shape, both.B.shape, both.D.shape) == ((6, 6), (6, 4), (4, 4))
    assert both.G.tolist() == [
        [0.0, 1.1, 1.3, 0.0],
        [0.0, 0.0, 0.0, 1.0],
        [1.0, 0.0, 0.0, 0.0],
        [0.0, 1.7, 1.9, 0.0],
        [0.0, 2.3, 2.9, 0.0],
    ]
    assert both.K.tolist() == [
        [0.0, 0.0, 1.0, 0.0, 0.0],
        [0.6, 0.0, 0.0, 0.8, 0.9],
        [1.2, 0.0, 0.0, 1.4, 1.6],
        [0.0, 0.0, 0.0, 0.0, 0.0],
    ]
    assert both.E[2].tolist() == [0.1, 0.0, 0.0, 0.2, 0.3] and both.E[5].tolist() == [0.0, -3.0, 0.0, 0.0, 0.0]
    assert both.F[3].tolist() == [0.0, 0.0, 0.03, 0.05, 0.0, 0.0]


def test_the_loop_through_one_step_counts_what_is_fed_back_alone():
    m = unlike()
    steepest = [hysteresis.steepest_slope(model) for model in m.bank]
    assert steepest == pytest.approx([0.5 + 0.1 * (1 + 1.2 / 0.8), 0.4, 0.7], rel=1e-12)
    end = lti.first_order_hold(m.A, m.E, 0.25)[2]
    returned = [sum(abs(m.F[i] @ end[:, j]) * steepest[j] for j in range(3)) for i in range(3)]
    assert mirror.contraction(m, 0.25) == pytest.approx(max(returned), rel=1e-12)
    alone = replace(m, F=np.array([[0.0, 0.0], [0.03, 0.05], [0.0, 0.0]]))
    only = abs(alone.F[1] @ end[:, 1]) * 0.4
    assert mirror.contraction(alone, 0.25) == pytest.approx(only, rel=1e-12)
    assert mirror.contraction(replace(m, F=np.zeros((3, 2))), 0.25) == 0.0


def test_a_transfer_function_that_is_negative_where_it_is_normalised_keeps_its_sign(table):
    given = with_linear(
        table, numerator=(-3.0, -2e4), denominator=(1e-3, 4.0, 9e4), normalise_at_hz=40.0, excited_from_hz=5.0
    ).linear
    at = 2j * pi * 40.0
    response = (-3.0 * at - 2e4) / (1e-3 * at**2 + 4.0 * at + 9e4)
    system, gain = mirror.linear_part(given)
    assert gain == pytest.approx(-abs(response), rel=1e-9)
    found = lti.frequency_response(system, np.array([0.0, 40.0]))[:, 0, 0]
    assert_allclose(found, [-2.0 / 9.0 / gain, response / gain], rtol=1e-9)


@pytest.mark.parametrize(
    ("ask", "message"),
    [
        (
            lambda: Mirror.of(PLAYS, [1.0], [1.0, 0.0, 3.0], name="wobbly"),
            "the linear part of mirror 'wobbly' has a numerator of 1 and a denominator of 3 coefficients: give one "
            "that is strictly proper and stable (every root of the denominator left of the imaginary axis) and that "
            "passes a constant",
        ),
        (
            lambda: Mirror.of(PLAYS, [1.0], [[1.0, 3.0]], name="square"),
            "mirror 'square': numerator and denominator have to be rows of finite coefficients",
        ),
        (
            lambda: Mirror.of(PLAYS, [1.0], [1e-300, 3.0], name="thin"),
            "the denominator of mirror 'thin' begins with 1e-300, nothing beside the others",
        ),
        (
            lambda: Mirror.of(PLAYS, creep=replace(SLOW, time_constants_s=(nan, 1.0))),
            "time_constants_s of the creep model is [nan  1.]: give finite numbers",
        ),
        (
            lambda: mirror.assemble("x", "additive", None, PLAYS),
            'composition "additive" needs a linear part; give one or choose "static"',
        ),
        (
            lambda: unlike().response([1.0, 2.0], 0.1),
            "drive_v has shape (2,): mirror 'unlike' takes finite samples of shape (samples, 2)",
        ),
        (
            lambda: unlike().response([[1.0, 2.0, 3.0]], 0.1),
            "drive_v has shape (1, 3): mirror 'unlike' takes finite samples of shape (samples, 2)",
        ),
        (
            lambda: unlike().response([[1.0, inf]], 0.1),
            "drive_v has shape (1, 2): mirror 'unlike' takes finite samples of shape (samples, 2)",
        ),
        (lambda: unlike().response([[1.0, 2.0]], 0.0), "step_s is 0.0 s: give the time between two samples, above 0"),
        (
            lambda: unlike().frequency_response([[1.0, 2.0]]),
            "freq_hz has shape (1, 2): give one row of finite frequencies",
        ),
        (
            lambda: replace(unlike(), F=40.0 * unlike().F).response([[1.0, 2.0]], 2.0),
            "mirror 'unlike': the loop through F is no contraction at a step of 2 s; use a step of at most 0.125 s, or "
            "move the mean slope of the hysteresis into A",
        ),
    ],
)
def test_a_mirror_says_in_all_words_what_it_cannot_do(ask, message):
    with pytest.raises(ValueError) as refused:
        ask()
    assert str(refused.value) == message


def test_the_summary_of_a_mirror_with_faults_of_each_kind_word_by_word(tmp_path):
    path = tmp_path / "mirror.toml"
    path.write_text(
        'name = "m 7"\ntravel = "3 mrad"\ncomposition = "cascade"\nrate_limit = "512.5 V/s"\nbias = "5 V"\n'
        'drive_min = "0 V"\ndrive_max = "10 V"\n[bouc_wen]\nd1 = "80 urad/V"\nd2 = "0 s/V"\nepsilon = "-75 urad/V"\n'
        'delta = "4e-3 s/V"\nalpha = "1.5 1/V"\nbeta = "0.4 1/V"\n'
        '[creep]\ntime_constants = ["0.1 s", "1 s", "30 s"]\nweights = ["2 urad/V", "1 urad/V", "5 urad/V"]\n'
        '[linear]\npoles = ["150 Hz", "900 Hz"]\npole_dampings = [0.35, 1.0]\nnormalise_at = "200 Hz"\n'
        'excited_from = "160 Hz"\nexcited_to = "500 Hz"\n',
        encoding="utf-8",
    )
    summary = mirror_summary.summarise(load_mirror(path).mirror)

    def size(f):
        return 1 / (abs(complex(1 - (f / 150) ** 2, 0.7 * f / 150)) * abs(complex(1, f / 900)))

    rest, top = 1 / size(200.0), size(160.0) / size(200.0)
    assert str(summary).split("\n") == [
        "m 7: cascade, Bouc-Wen hysteresis",
        "  linear part divided by 1.00000, its magnitude at 200 Hz",
        f"  gain at DC {rest:.5f}, in the flat band from 160 to 160 Hz {top:.5f} to {top:.5f}",
        "  pole at 150 Hz, damping 0.350",
        "  pole at 900 Hz, damping 1.000",
        "  creep adds 10 % of the gain in the long run, with lags from 0.1 s to 30 s",
        "  rate in the hysteresis held at 512.5 V/s; clamped samples are counted",
        "  warning: not physical at reversals: the local slope falls to -0.125 mrad/V against d1 = 0.080 mrad/V, so "
        "the modelled mirror first moves the wrong way, by 26.0 µrad on a slow drive",
        "  warning: pole at 150 Hz lies outside the excited band (160 to 500 Hz): drift fitted as dynamics",
        "  warning: pole at 900 Hz lies outside the excited band (160 to 500 Hz): extrapolated",
        f"  warning: gain at DC {rest:.5f} is not the gain in the band, {top:.5f} to {top:.5f}",
    ]
    assert [root.in_band for root in summary.roots] == [False, False]
    assert (summary.flat_band_hz, summary.normalise_at_hz, summary.rate_limit_v_s) == ((160.0, 160.0), 200.0, 512.5)


IMPROPER = (
    "the linear part of mirror 'm' has a numerator of {} and a denominator of {} coefficients: give one that is "
    "strictly proper and stable (every root of the denominator left of the imaginary axis) and that passes a constant"
)
ROWS = "mirror 'm': numerator and denominator have to be rows of finite coefficients"


@pytest.mark.parametrize(
    ("top", "bottom", "message"),
    [
        ([1, 2, 3], [1, 2], IMPROPER.format(3, 2)),
        ([1], [1, 0], IMPROPER.format(1, 2)),
        ([1], [1, -2], IMPROPER.format(1, 2)),
        ([1], [1, 2, 3, 400], IMPROPER.format(1, 4)),
        ([1, 0], [1, 2, 3], IMPROPER.format(2, 3)),
        ([1], [0, 1, 2], IMPROPER.format(1, 3)),
        ([1], [[1, 2]], ROWS),
        ([], [1, 2], ROWS),
        ([1], [nan, 2], ROWS),
        ([1, inf], [1, 2, 3], ROWS),
        ([1], [1e-200, 1, 2], "the denominator of mirror 'm' begins with 1e-200, nothing beside the others"),
        (
            "x",
            [1, 2],
            "numerator of mirror 'm': no array of real numbers; give numbers, or lists of them that are equally long",
        ),
        (
            [1],
            ["y"],
            "denominator of mirror 'm': no array of real numbers; give numbers, or lists of them that are equally long",
        ),
    ],
)
def test_a_linear_part_of_polynomials_is_refused_in_all_words(top, bottom, message):
    with pytest.raises(ValueError) as refused:
        Mirror.of(1e-5, top, bottom, name="m")
    assert str(refused.value) == message


@pytest.mark.parametrize(
    ("ask", "message"),
    [
        (
            lambda m: m.response([], 1.0),
            "drive_v has shape (0,): mirror 'm' takes finite samples of shape (samples, 1)",
        ),
        (
            lambda m: m.response([[[1.0]]], 1.0),
            "drive_v has shape (1, 1, 1): mirror 'm' takes finite samples of shape (samples, 1)",
        ),
        (lambda m: m.response(1.0, 1.0), "drive_v has shape (): mirror 'm' takes finite samples of shape (samples, 1)"),
        (
            lambda m: m.response(["a"], 1.0),
            "drive_v: no array of real numbers; give numbers, or lists of them that are equally long",
        ),
        (lambda m: m.response([1.0], -0.25), "step_s is -0.25 s: give the time between two samples, above 0"),
        (lambda m: m.response([1.0], nan), "step_s is nan s: give the time between two samples, above 0"),
        (lambda m: m.frequency_response(inf), "freq_hz has shape (1,): give one row of finite frequencies"),
        (
            lambda m: m.frequency_response("a"),
            "freq_hz: no array of real numbers; give numbers, or lists of them that are equally long",
        ),
        (
            lambda m: replace(m, bouc_wen=(BoucWen(1e-5, 0, 1e-5, 5.0, 0.3, -5.3, 1e3),)).response([0, 1e3, 0], 1e-3),
            "mirror 'm' gives no finite output to this drive at a step of 0.001 s",
        ),
        (
            lambda m: Mirror.of_system(lti.StateSpace(*(np.array([[v]]) for v in (0.0, 1.0, 2.0, 3.0))), "q"),
            "the linear system of mirror 'q' is not stable: every pole has to have a decay",
        ),
    ],
)
def test_a_mirror_of_one_gain_refuses_in_all_words_what_makes_no_answer(ask, message):
    with pytest.raises(ValueError) as refused:
        ask(Mirror.of(1e-5, name="m"))
    assert str(refused.value) == message


def test_a_gain_behind_no_linear_part_is_static_whatever_number_divides_it():
    for bottom in ([7.0], 7.0, (7,)):
        m = Mirror.of(3e-5, [2.0], bottom)
        assert (m.name, m.A.shape, m.K.tolist(), m.D.tolist()) == ("mirror", (0, 0), [[1.0]], [[0.0]])
        assert m.response([1.0, -2.0], 0.1).tolist() == [3e-5, -6e-5]
        assert m.inverse == m.bouc_wen == (BoucWen(3e-5, 0.0, 0.0, 0.0, 0.0, 0.0),)
        assert m.frequency_response(3.0).tolist() == [[[3e-5]]]


@pytest.mark.parametrize(
    ("system", "axes", "actuators"),
    [
        ((np.array([[-1.0]]), np.ones((1, 2)), np.ones((3, 1)), np.arange(6.0).reshape(3, 2)), 3, 2),
        ((np.zeros((0, 0)), np.ones((0, 2)), np.ones((3, 0)), np.arange(6.0).reshape(3, 2)), 3, 2),
        ((np.diag([-1.0, -5.0]), np.array([[1.0], [2.0]]), np.array([[3.0, 4.0]]), np.array([[0.5]])), 1, 1),
    ],
)
def test_a_linear_system_is_a_mirror_of_its_matrices_without_a_bank(system, axes, actuators):
    A, B, C, D = system
    m = Mirror.of_system(lti.StateSpace(*system), "q")
    for name, matrix in zip("ABCD", system, strict=True):
        assert_array_equal(getattr(m, name), matrix)
    assert (m.name, m.axes, m.actuators, m.bank, m.inverse, m.inverse_creep) == ("q", axes, actuators, (), (), ())
    shapes = [(len(A), 0), (0, len(A)), (0, actuators), (axes, 0)]
    assert [getattr(m, name).shape for name in "EFGK"] == shapes
    at = 2j * pi * 0.7
    seen = C @ np.linalg.solve(at * np.eye(len(A)) - A, B) + D
    assert_allclose(m.frequency_response([0.0, 0.7])[1], seen, rtol=1e-12)


HEAD = (
    'name = "n"\ntravel = "3 mrad"\ncomposition = "cascade"\nrate_limit = "1234567 V/s"\nbias = "5 V"\n'
    'drive_min = "0 V"\ndrive_max = "10 V"\n'
)
TWO_PLAYS = '[prandtl_ishlinskii]\nthresholds = ["0 V", "1 V"]\nweights = ["40 urad/V", "10 urad/V"]\n'


def test_the_summary_of_a_gain_below_0_has_its_size_at_dc_and_in_the_band(tmp_path):
    """-300 s - 6e5 over s^2 + 100 s + 250000, flat at 10 Hz alone as its pair lies at 80 Hz."""
    path = tmp_path / "mirror.toml"
    path.write_text(
        f"{HEAD}{TWO_PLAYS}[linear]\nnumerator = [-300.0, -6e5]\ndenominator = [1.0, 100.0, 250000.0]\n"
        'normalise_at = "20 Hz"\nexcited_from = "10 Hz"\nexcited_to = "250 Hz"\n'
    )
    summary = mirror_summary.summarise(load_mirror(path).mirror)
    assert str(summary).split("\n") == [
        "n: cascade, Prandtl-Ishlinskii hysteresis",
        "  linear part divided by -2.56318, its magnitude at 20 Hz",
        "  gain at DC 2.40000, in the flat band from 10 to 10 Hz 2.43892 to 2.43892",
        "  pole at 79.58 Hz, damping 0.100",
        "  zero at 318.3 Hz, damping 1.000",
        "  valid to 1.235e+06 V/s",
        "  warning: zero at 318 Hz lies outside the excited band (10 to 250 Hz): extrapolated",
    ]
    assert [(r.kind, r.in_band) for r in summary.roots] == [("pole", True), ("zero", False)]
    assert summary.normalised_by == pytest.approx(-2.563183493, rel=1e-9) and summary.dc_gain == pytest.approx(2.4)


def test_the_summary_of_roots_on_both_sides_of_the_band_and_of_the_plane_word_by_word(tmp_path):
    path = tmp_path / "mirror.toml"
    widening = TWO_PLAYS.replace("weights", 'widening = "2e-4 s"\nweights')
    path.write_text(
        f'{HEAD}{widening}[linear]\npoles = ["20 Hz", "400 Hz", "35 Hz"]\npole_dampings = [1.0, 0.2, 0.5]\n'
        'zeros = ["7 Hz", "90 Hz"]\nzero_dampings = [0.3, -1.0]\nnormalise_at = "50 Hz"\nexcited_from = "10 Hz"\n'
        'excited_to = "250 Hz"\n'
    )
    summary = mirror_summary.summarise(load_mirror(path).mirror)

    def pair(f, of, damping):
        return abs(complex(1 - (f / of) ** 2, 2 * damping * f / of))

    def size(f):
        below = pair(f, 400.0, 0.2) * pair(f, 35.0, 0.5) * abs(complex(1, f / 20))
        return pair(f, 7.0, 0.3) * abs(complex(1, f / 90)) / below

    rest, low = 1 / size(50.0), size(10.0) / size(50.0)
    assert str(summary).split("\n") == [
        "n: cascade, Prandtl-Ishlinskii hysteresis",
        "  linear part divided by 1.00000, its magnitude at 50 Hz",
        f"  gain at DC {rest:.5f}, in the flat band from 10 to 10 Hz {low:.5f} to {low:.5f}",
        "  pole at 20 Hz, damping 1.000",
        "  pole at 400 Hz, damping 0.200",
        "  pole at 35 Hz, damping 0.500",
        "  zero at 7 Hz, damping 0.300",
        "  zero at 90 Hz, damping -1.000",
        "  rate in the hysteresis held at 1.235e+06 V/s; clamped samples are counted",
        "  warning: pole at 400 Hz lies outside the excited band (10 to 250 Hz): extrapolated",
        "  warning: zero at 7 Hz lies outside the excited band (10 to 250 Hz): drift fitted as dynamics",
        f"  warning: gain at DC {rest:.5f} is not the gain in the band, {low:.5f} to {low:.5f}",
    ]


@pytest.mark.parametrize(("often", "axes", "unroll"), [(False, 1, 0), (True, 1, 1), (True, 2, 0), (False, 2, 0)])
def test_loops_are_unrolled_for_one_axis_that_is_simulated_often(often, axes, unroll):
    one = mirror.assemble("m", "cascade", RESONANT[0], PLAYS, CREEP)
    assert not mirror.unrolled(one)
    plant = mirror.discretise(one if axes == 1 else mirror.combine(one, one), STEP, often=often)
    assert isinstance(plant.states, tuple) == bool(unroll)


@pytest.mark.parametrize("composition", ["static", "cascade", "additive"])
def test_an_answer_is_the_same_by_rows_and_by_columns(composition):
    one = mirror.assemble("m", composition, RESONANT[0], WIDENING, CREEP)
    plant = mirror.discretise(one, STEP)
    drive, output = zigzag(5)[:, None], np.empty((120, 1))
    mirror.respond(plant, mirror.at_rest(plant), drive, output, np.empty((120, 0)))
    assert_allclose(output, run(one, drive)[0], atol=one_femtoradian)
    assert_allclose(one.response(drive[:, 0], STEP), output[:, 0], atol=one_femtoradian)


@pytest.mark.parametrize(
    ("zero_hz", "low", "high", "band", "shown"),
    [
        (50, "1", "250", (1.0, 40.0), "from 1 to 40 Hz"),
        (390, "1.2345", "25.6", (1.2345, 25.6), "from 1.2345 to 26 Hz"),
        (20, "12.3456", "250", (12.3456, 40.0), "from 12.3456 to 40 Hz"),
    ],
)
def test_a_zero_ends_no_flat_band_and_the_edges_are_told(tmp_path, zero_hz, low, high, band, shown):
    """Two pairs of poles from 400 Hz on, and a pair of zeros far below them or beside."""
    path = tmp_path / "mirror.toml"
    path.write_text(
        f'{HEAD}{TWO_PLAYS}[linear]\npoles = ["400 Hz", "900 Hz"]\npole_dampings = [0.2, 0.3]\n'
        f'zeros = ["{zero_hz} Hz"]\nzero_dampings = [0.1]\n'
        f'normalise_at = "20.125 Hz"\nexcited_from = "{low} Hz"\nexcited_to = "{high} Hz"\n'
    )
    summary = mirror_summary.summarise(load_mirror(path).mirror)
    assert_allclose(summary.flat_band_hz, band, rtol=1e-12)
    text = str(summary)
    assert "\n  linear part divided by 1.00000, its magnitude at 20.125 Hz\n" in text
    assert f", in the flat band {shown} " in text
    outside = [f"pole at {hz} Hz lies outside the excited band ({low} to {high} Hz): extrapolated" for hz in (400, 900)]
    assert [each for each in summary.warnings if "pole" in each] == outside


@pytest.mark.parametrize(
    ("top", "bottom"),
    [([3.0], [0.5, 2.0]), ([1.0, -4.0], [1.0, 3.0, 2.0]), ([2.0, 8.0], [3.0, 5.0, 7.0, 2.0]), ([-0.25], [1.0, 1.0])],
)
def test_polynomials_of_any_gain_at_rest_have_that_of_the_hysteresis_with_creep_beside_it(top, bottom):
    m = Mirror.of(PLAYS, top, bottom, creep=Creep((5e-6,), (0.2,)), name="p")
    s = 2j * pi * np.array([0.0, 0.3])
    shape = np.polyval(top, s) / np.polyval(bottom, s) * bottom[-1] / top[-1]
    expected = hysteresis.slow_gain(PLAYS) * shape + 5e-6 / (1 + 0.2 * s)
    assert_allclose(m.frequency_response([0.0, 0.3])[:, 0, 0], expected, rtol=1e-9)
    assert (m.name, m.inverse, m.inverse_creep) == ("p", (PLAYS,), (Creep((5e-6,), (0.2,)),))


def test_zeros_before_the_numerator_of_a_linear_part_are_no_powers():
    long, short = (Mirror.of(1e-5, top, [1.0, 1.0]) for top in ([0, 0, 1], [1]))
    for key in "ABCD":
        assert getattr(long, key).tolist() == getattr(short, key).tolist()
    assert Mirror.of(1e-5, [0, 2], [7]).A.shape == (0, 0)


@pytest.mark.parametrize("bottom", [[1.0], [1.0, 1.0]])
@pytest.mark.parametrize("constants", [(0.1, 0.2), (-0.1,)])
def test_a_mirror_refuses_creep_whose_weights_do_not_fit_its_lags(bottom, constants):
    words = "creep of 1 weights and the time constants .*: give as many weights, and time constants above 0"
    with pytest.raises(ValueError, match=words):
        Mirror.of(1e-5, [1.0], bottom, creep=Creep((1e-6,), constants))


def test_small_numbers_of_a_summary_are_not_rounded_to_none(table):
    slow = with_linear(table, poles_hz=(3.0,), pole_dampings=(0.5,), excited_from_hz=0.1)
    summary = mirror_summary.summarise(slow)
    assert "in the flat band from 0.1 to 0.3 Hz " in str(summary)
    creeping = replace(summary, creep=mirror_summary.Creep((1e-6,), (0.1,)))
    assert str(creeping).count("% of the gain in the long run, with a lag of 0.1 s\n") == 1
    assert [mirror_summary._mrad_v(x) for x in (-3e-7, 1e-5, 0.5)] == ["-0.0003", "0.010", "500.000"]


@pytest.mark.parametrize(("rate_v_s", "shown"), [(0.25, "0.25"), (10.0, "10"), (886.75, "886")])
def test_a_rate_below_ten_volts_a_second_is_told_in_digits_and_others_are_never_rounded_up(rate_v_s, shown):
    model = mirror_summary.BoucWen(1e-6, 1e-7, 1.0, 0.0, 0.0, 0.0)
    limited = SimpleNamespace(reversal_slope_rad_v=lambda: 1.0, admissible_rate_v_s=rate_v_s, rate_limit_v_s=900.0)
    assert not isinstance(model, mirror_summary.PrandtlIshlinskii)
    assert mirror_summary._admissibility(limited) == (
        f"the slope after a reversal stays positive only up to {shown} V/s before the reversal",
    )


def test_a_mirror_whose_poles_cannot_be_told_apart_is_refused_with_its_file():
    path = TESTS / "corpus" / "bad" / "mirrors" / "poles-far-from-each-other.toml"
    with pytest.raises(MissionError) as refused:
        read_mirror(path)
    (fault,) = refused.value.faults
    assert (fault.key, fault.file, fault.expected) == ("linear", str(path), "poles that can be told apart")
    assert fault.reason == (
        "the linear part of the mirror: poles nearly coincide: the transfer function has no accurate modal form; give "
        "poles and pole_dampings in place of numerator and denominator"
    )


@pytest.mark.parametrize(
    ("top", "bottom", "message"),
    [
        ([1e30], [1e-125, 1.0], "the denominator of mirror 'm' begins with 1e-125, nothing beside the others"),
        (
            [1.0, 1e-300],
            [1.0, 3.0, 2.0],
            "the linear part of mirror 'm' has a gain at rest of 0: look at its coefficients",
        ),
    ],
)
def test_a_numerator_too_large_for_its_denominator_or_with_no_gain_at_rest_is_refused(top, bottom, message):
    with pytest.raises(ValueError) as refused:
        Mirror.of(PLAYS, top, bottom, name="m")
    assert str(refused.value) == message
