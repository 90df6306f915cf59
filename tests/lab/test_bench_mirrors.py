"""The mirrors of the virtual bench: against slow twins, and for what a real mirror shows - loops, rate, creep."""

import math

import numpy as np
import pytest

from microrad.core import lti
from microrad.core.kernels import play_response
from microrad.lab.bench.mirrors import (
    _SETTLED,
    EQ2_DENOMINATOR,
    EQ2_NUMERATOR,
    EQ3,
    FINE_STEP_S,
    Amplifier,
    BenchMirror,
    _approach,
    _MirrorState,
    _modes,
    _moving,
    _straight_line,
    _stretches,
    bench_output,
    bouc_wen_output,
    linear_output,
)

RATE_HZ = 50e3
AMPLIFIER = Amplifier(5e3, 1e6 / 15)
HALVING_MRAD = 2e-5  # 0.02 microradian, as `FINE_STEP_S` says


def philox(seed):
    return np.random.Generator(np.random.Philox(seed))


def sine(freq_hz, amplitude_v, periods, rate_hz=RATE_HZ):
    n = round(periods * rate_hz / freq_hz)
    return 6.0 + amplitude_v * np.sin(2 * np.pi * freq_hz * np.arange(n) / rate_hz)


def lag_deg(freq_hz, amplitude_v):
    """Phase lag of the fundamental in the second period, which a loop's area makes grow."""
    drive = sine(freq_hz, amplitude_v, 2)
    output = bench_output(drive, 6.0, RATE_HZ, AMPLIFIER)
    half = drive.size // 2
    spectra = [np.fft.rfft(values[half:])[1] for values in (drive, output)]
    return -math.degrees(np.angle(spectra[1] / spectra[0])), abs(spectra[1] / spectra[0])


# ---- slow twins
def slow_bench_output(drive, rest_v, rate_hz, amplifier, substeps):
    """The equations of the module's docstring in small steps, one after the other, without creep's closed form."""
    m = BenchMirror()
    step_s = 1.0 / rate_hz / substeps
    poles, zeros = np.roots(EQ2_DENOMINATOR), np.roots(EQ2_NUMERATOR)
    poles, zeros = (r[np.argsort(np.abs(r))][1:] for r in (poles, zeros))
    num, den = np.real(np.poly(zeros)), np.real(np.poly(poles))
    system = lti.modal_from_polynomials(tuple(num * den[-1] / num[-1]), tuple(den))
    Ad, B0, B1 = lti.first_order_hold(system.A, system.B, step_s)
    v = smooth = rest_v
    plays, thresholds, weights = np.full(m.operators, rest_v), m.thresholds_v, m.weights_mrad_v
    settled = strain = m.at_rest(rest_v)
    x, lags = np.zeros(system.order), np.zeros(m.lag_times_s.size)
    output = []
    for command in drive:
        creep = m.creep_share_decade / m.lags_per_decade * lags.sum()
        output.append(settled + float((system.C @ x)[0]) + creep)
        for _ in range(substeps):
            rate = np.clip((command - v) / amplifier.time_constant_s, -amplifier.slew_v_s, amplifier.slew_v_s)
            v = v + step_s * rate
            smooth = smooth + step_s * (v - smooth) / m.viscous_smoothing_s
            q = v - m.viscous_v * math.asinh((v - smooth) / m.viscous_smoothing_s / m.viscous_rate_v_s)
            plays = np.maximum(q - thresholds, np.minimum(q + thresholds, plays))
            extension = m.direct_mrad_v * v + float(weights @ plays)
            before, strain = strain, extension + m.curvature_1_mrad * extension**2
            x = Ad @ x + B0[:, 0] * (before - settled) + B1[:, 0] * (strain - settled)
            lags = lags + step_s * (strain - settled - lags) / m.lag_times_s
    return np.array(output)


@pytest.mark.promise("bench-9")
@pytest.mark.parametrize("kind", ["smooth", "slewing"])
def test_the_benchs_mirror_agrees_with_small_euler_steps(kind):
    if kind == "smooth":
        drive, amplifier = sine(1000.0, 3.0, 2), AMPLIFIER
    else:
        drive, amplifier = np.repeat([6.0, 9.0, 2.0], 30), Amplifier(5e3, 2e4)
    fast = bench_output(drive, 6.0, RATE_HZ, amplifier)
    errors = [np.abs(slow_bench_output(drive, 6.0, RATE_HZ, amplifier, n) - fast).max() for n in (20, 40)]
    assert errors[1] < 0.01 * np.ptp(fast)
    assert 1.8 < errors[0] / errors[1] < 2.2  # Euler's first order, towards the fast one
    assert np.ptp(fast) > 0.1


@pytest.mark.promise("bench-9")
def test_halving_the_fine_step_changes_nothing_beyond_the_stated_bound():
    assert FINE_STEP_S == 2.5e-6
    chirp = 6.0 + 0.5 * np.sin(2 * np.pi * (10.0 * np.arange(20_000) / RATE_HZ) * 10.0 ** np.linspace(0, 2.4, 20_000))
    for drive, rate_hz in (
        (chirp, RATE_HZ),
        (sine(100.0, 6.0, 2), RATE_HZ),
        (np.repeat([6.0, 12.0, 1.0], 1000), RATE_HZ),
        (sine(1.0, 5.0, 0.2, 1e3), 1e3),
    ):
        once, twice, coarse = (
            bench_output(drive, 6.0, rate_hz, AMPLIFIER, fine_step_s=s) for s in (FINE_STEP_S, FINE_STEP_S / 2, 2e-5)
        )
        assert 0.0 < np.abs(once - twice).max() < HALVING_MRAD
        assert np.abs(coarse - twice).max() > np.abs(once - twice).max()


def test_standing_still_is_stepped_by_samples_without_a_difference():
    """A creep record at a low rate: the long waits take one step a sample, the moves many."""
    drive = np.concatenate([np.full(50, 6.0), np.linspace(6.0, 9.0, 6), np.full(400, 9.0), np.full(400, 4.0)])
    whole = bench_output(drive, 6.0, 1e3, AMPLIFIER)
    wiggling = drive + 1e-13 * (-1.0) ** np.arange(drive.size)  # never at rest: always fine
    fine = bench_output(wiggling, 6.0, 1e3, AMPLIFIER)
    assert np.abs(whole - fine).max() < 1e-9
    assert np.ptp(whole) > 0.4


@pytest.mark.promise("bench-5", "bench-10")
def test_eq2_is_played_as_printed():
    drive = 6.0 + 0.5 * philox(1).standard_normal(2000)
    system = lti.modal_from_polynomials(EQ2_NUMERATOR, EQ2_DENOMINATOR)
    Ad, Bd = lti.zero_order_hold(system.A, system.B, 1 / RATE_HZ)
    x, expected = np.zeros(system.order), []
    for u in drive - 6.0:
        expected.append(float((system.C @ x)[0]))
        x = Ad @ x + Bd[:, 0] * u
    output = linear_output(drive, 6.0, RATE_HZ)
    assert output[0] == pytest.approx(6.0 * 0.16255, rel=1e-4)  # settled, at the printed gain at rest
    assert np.allclose(output - output[0], expected, rtol=0, atol=1e-10)
    assert np.ptp(expected) > 0.05


@pytest.mark.promise("bench-5", "bench-10")
def test_eq3_is_played_as_printed():
    drive = sine(100.0, 6.0, 3)
    output = bouc_wen_output(drive, 6.0, RATE_HZ)
    rate = np.diff(drive, prepend=6.0) * RATE_HZ
    h = (output - EQ3[0] * np.exp(-EQ3[1] * rate) * drive)[drive.size // 3 :]
    assert np.abs(h).max() == pytest.approx(0.074443, rel=2e-3)  # an adaptive solver's number
    assert 100 * np.ptp(h) / np.ptp(output[drive.size // 3 :]) == pytest.approx(14.05, rel=2e-3)


@pytest.mark.promise("bench-10")
def test_the_first_sample_that_a_drive_can_move_is_the_one_behind_it():
    """But for Eq. 3, whose drive is straight between the samples."""
    drive = np.repeat([6.0, 6.5], [10, 50])
    held = bench_output(drive, 6.0, RATE_HZ, AMPLIFIER), linear_output(drive, 6.0, RATE_HZ)
    for output in held:
        assert np.ptp(output[:11]) < 1e-12
        assert abs(output[11] - output[10]) > 1e-6
    straight = bouc_wen_output(drive, 6.0, RATE_HZ)
    assert abs(straight[10] - straight[9]) > 0.04  # d1 x 0.5 V


# ---- what a real mirror shows
@pytest.mark.promise("gallery-6")
def test_gain_and_loop_grow_with_amplitude():
    lags, gains = zip(*(lag_deg(10.0, amplitude) for amplitude in (0.1, 0.5, 2.0, 6.0)), strict=True)
    assert np.all(np.diff(lags) > 0.1)
    assert np.all(np.diff(gains) > 1e-4)
    assert 0.076 < gains[0] < 0.080
    assert 0.088 < gains[-1] < 0.092


@pytest.mark.promise("bench-9")
def test_the_loop_grows_mildly_with_rate():
    """Beyond the lag that a small sine has at the same frequency, which is linear."""
    slow, fast = (lag_deg(f, 6.0)[0] - lag_deg(f, 0.1)[0] for f in (2.0, 60.0))
    assert 1.05 < fast / slow < 1.5


@pytest.mark.promise("bench-9")
def test_the_two_branches_of_a_loop_differ():
    drive = sine(5.0, 6.0, 2)
    output = bench_output(drive, 6.0, RATE_HZ, AMPLIFIER)[drive.size // 2 :]
    second = np.fft.rfft(output)[:4]
    assert 0.002 < abs(second[2]) / abs(second[1]) < 0.02


@pytest.mark.promise("bench-9")
def test_creep_behind_a_step_is_logarithmic_over_decades():
    rate_hz = 50.0
    drive = np.concatenate([np.full(20, 6.0), np.full(round(1000 * rate_hz), 9.0)])
    output = bench_output(drive, 6.0, rate_hz, AMPLIFIER)[20:]
    at = [output[round(t * rate_hz)] for t in (0.1, 1.0, 10.0, 100.0, 999.0)]
    step = at[0] - BenchMirror().at_rest(6.0)
    decades = np.diff(at) / step
    assert 0.2 < step < 0.3
    assert np.all((decades > 0.007) & (decades < 0.012))
    assert decades.max() / decades.min() < 1.25
    back = bench_output(np.repeat([6.0, 3.0], [20, 500]), 6.0, rate_hz, AMPLIFIER)
    assert np.all(np.diff(back[70::50]) < 0)


@pytest.mark.promise("bench-9")
def test_a_resting_mirror_stays_where_it_is():
    output = bench_output(np.full(5000, 7.0), 7.0, RATE_HZ, AMPLIFIER)
    assert np.ptp(output) < 1e-12
    assert output[0] == pytest.approx(BenchMirror().at_rest(7.0))


@pytest.mark.promise("bench-5", "bench-9")
def test_a_slow_amplifier_and_a_slew_limit_hold_the_mirror_back():
    drive = np.repeat([6.0, 9.0], [10, 4000])
    usual, narrow, slewing = (
        bench_output(drive, 6.0, RATE_HZ, amplifier)
        for amplifier in (AMPLIFIER, Amplifier(50.0, 1e6), Amplifier(5e3, 1e3))
    )
    reach = [np.argmax(y - y[0] > 0.8 * (y[-1] - y[0])) - 10 for y in (usual, narrow, slewing)]
    assert reach[0] < 20
    assert 200 < reach[1] < 400  # 1.6 time constants of 3.2 ms
    assert 100 < reach[2] < 150  # 2.4 V at 1 V/ms


@pytest.mark.promise("bench-9")
def test_the_density_of_plays_is_smooth():
    weights = BenchMirror().weights_mrad_v
    assert weights.size == 60
    assert np.all(weights > 0)
    assert weights.sum() == pytest.approx(0.021)
    assert np.abs(np.diff(weights, 2)).max() < 0.2 * weights.max()


@pytest.mark.promise("bench-9")
def test_creep_is_spread_evenly_over_seven_decades():
    """Each lag stands in the middle of its half of a decade."""
    mirror = BenchMirror()
    half = math.sqrt(10.0) ** 0.5
    assert mirror.lag_times_s[0] / half == pytest.approx(0.01)
    assert mirror.lag_times_s[-1] * half == pytest.approx(1e5)
    assert np.diff(np.log10(mirror.lag_times_s)) == pytest.approx(np.full(13, 0.5))
    assert mirror.creep_share_decade == 0.01


@pytest.mark.promise("bench-9")
def test_rest_is_what_a_decaying_sine_leaves():
    """Each play operator ends within the last decrement of the sine, 10 V x 20 / 4000, of the middle."""
    mirror, samples = BenchMirror(), np.arange(4000)
    drive = 7.0 + 10.0 * (1.0 - samples / samples[-1]) * np.sin(2 * np.pi * samples / 20)
    plays = play_response(drive, mirror.thresholds_v, np.full(mirror.operators, 0.0))[-1]
    assert np.abs(plays - 7.0).max() < 0.06
    extension = mirror.direct_mrad_v * drive[-1] + mirror.weights_mrad_v @ plays
    assert mirror.saturated(np.array(extension)) == pytest.approx(mirror.at_rest(7.0), rel=2e-3)
    assert mirror.at_rest(7.0) != pytest.approx(mirror.at_rest(7.1), rel=2e-3)


def test_another_mirror_may_stand_in_the_place_of_the_benchs_own():
    """Without plays, saturation, lag and creep a step of 1 V is answered with the direct part alone, once it rings."""
    plain = BenchMirror(play_mrad_v=0.0, curvature_1_mrad=0.0, creep_share_decade=0.0)
    drive = np.repeat([6.0, 7.0], [5, 400])
    output = bench_output(drive, 6.0, RATE_HZ, AMPLIFIER, plain)
    assert output[0] == pytest.approx(6.0 * 0.079, rel=1e-9)
    assert output[-1] == pytest.approx(7.0 * 0.079, rel=1e-3)
    assert bench_output(drive, 6.0, RATE_HZ, AMPLIFIER)[0] == pytest.approx(BenchMirror().at_rest(6.0), rel=1e-9)


# ---- parts by themselves
@pytest.mark.parametrize(("value", "command"), [(2.0, 9.5), (9.5, 2.0), (2.0, 2.3), (-1.0, -1.0)])
def test_an_approach_slews_and_then_decays_as_small_steps_do(value, command):
    tau, slew = 3e-3, 500.0
    step_s, at = 1e-5, [value]
    for _ in range(5000):
        at.append(at[-1] + step_s * min(max((command - at[-1]) / tau, -slew), slew))
    marks = np.array([10, 700, 2000, 5000])
    np.testing.assert_allclose(
        _approach(value, command, marks * step_s, tau, slew), np.array(at)[marks], rtol=0, atol=5e-3
    )
    if abs(command - value) > 1.5:  # the line alone
        assert _approach(value, command, 1e-3, tau, slew) == pytest.approx(value + math.copysign(0.5, command - value))


@pytest.mark.parametrize("pole", [-3.0, -1e-5, -0.9 + 40.0j, -2e3])
def test_a_step_of_a_line_is_the_integral_of_its_input(pole):
    """By the midpoint rule: of an input of 1, and of one that rises from 0 to 1."""
    step_s, count = 0.003, 4000
    decay, start, end = _straight_line(np.array(pole), step_s)
    at = (np.arange(count) + 0.5) / count
    weight = np.exp(pole * step_s * (1 - at)) * step_s / count
    assert abs(decay - np.exp(pole * step_s)) < 1e-15
    assert abs(end - np.sum(weight * at)) < 1e-6 * abs(end)
    assert abs(start - np.sum(weight * (1 - at))) < 1e-6 * abs(start)


def test_stretches_of_moving_samples_have_their_ends_and_last_until_all_has_settled():
    assert _stretches(np.array([True, True, False, False, False, True])) == [(0, 2, True), (2, 5, False), (5, 6, True)]
    assert _stretches(np.array([False])) == [(0, 1, False)]
    run = _MirrorState(BenchMirror(), Amplifier(100.0, 50.0), 1.0, 1e-3)
    drive = np.full(300, 1.0)
    drive[40:] = 3.5
    moving = _moving(drive, 1.0, run)
    settle = math.ceil((_SETTLED / (2 * math.pi * 100.0) + 2.5 / 50.0) / 1e-3)
    assert np.flatnonzero(moving).tolist() == list(range(40, 40 + settle))
    slower = _MirrorState(BenchMirror(viscous_smoothing_s=2e-3), Amplifier(100.0, 50.0), 1.0, 1e-3)
    assert np.count_nonzero(_moving(drive, 1.0, slower)) == math.ceil((_SETTLED * 2e-3 + 2.5 / 50.0) / 1e-3)
    assert _moving(np.full(5, 1.0), 2.0, run).all() and not _moving(np.full(5, 1.0), 1.0, run).any()


def test_a_mirror_of_other_numbers_rests_saturates_and_spreads_by_its_own():
    mirror = BenchMirror(0.05, 0.03, 4, 6.0, 1.5, 0.02, creep_first_s=0.3, creep_decades=2, lags_per_decade=3)
    np.testing.assert_allclose(mirror.thresholds_v, [1.5, 3.0, 4.5, 6.0])
    density = np.array([(0.15 + r) * math.exp(-(r**1.3)) for r in (1.0, 2.0, 3.0, 4.0)])
    np.testing.assert_allclose(mirror.weights_mrad_v, 0.03 * density / density.sum(), rtol=1e-12)
    np.testing.assert_allclose(mirror.lag_times_s, 0.3 * 10.0 ** (np.arange(1, 12, 2) / 6), rtol=1e-12)
    assert mirror.at_rest(5.0) == pytest.approx(0.4 + 0.02 * 0.16, rel=1e-12)
    np.testing.assert_allclose(mirror.saturated(np.array([-0.5, 2.0])), [-0.495, 2.08], rtol=1e-12)
    assert Amplifier(40.0, 1.0).time_constant_s == pytest.approx(1 / (80 * math.pi), rel=1e-12)


def test_modes_of_a_fraction_are_its_poles_above_the_line_with_residues_of_both():
    """(3 s + 5) / ((s + 2)(s^2 + 2 s + 17)): a real pole and a pair of -1 + 4i."""
    poles, residues = _modes((3.0, 5.0), tuple(2.5 * np.poly([-2.0, -1 + 4j, -1 - 4j]).real))
    order = np.argsort(poles.imag)
    np.testing.assert_allclose(poles[order], [-2.0, -1 + 4j], rtol=1e-9)
    pair = 2 * (3 * (-1 + 4j) + 5) / 2.5 / ((-1 + 4j + 2) * 8j)
    np.testing.assert_allclose(residues[order], [-1 / 2.5 / 17.0, pair], rtol=1e-9)


@pytest.mark.parametrize("cut", [1, 7, 60])
def test_a_record_in_parts_goes_on_where_the_part_before_ended(cut):
    drive = np.ascontiguousarray(6.0 + 3.0 * np.sin(np.arange(120) / 9.0))
    amplifier = Amplifier(800.0, 900.0)
    whole = _MirrorState(BenchMirror(operators=5), amplifier, 6.2, 1e-3)
    volts = whole.amplified(drive)
    fast, strain = whole.advance(drive, volts, 4)
    parts = _MirrorState(BenchMirror(operators=5), amplifier, 6.2, 1e-3)
    pieces = [parts.advance(drive[a:b], volts[a:b], 4) for a, b in ((0, cut), (cut, 100), (100, 120))]
    np.testing.assert_allclose(np.concatenate([piece[0] for piece in pieces]), fast, rtol=0, atol=1e-12)
    np.testing.assert_allclose(np.concatenate([piece[1] for piece in pieces]), strain, rtol=0, atol=1e-12)
    assert np.ptp(fast) > 0.01


def test_an_amplifier_that_slews_somewhere_goes_from_sample_to_sample():
    run = _MirrorState(BenchMirror(), Amplifier(30.0, 100.0), 1.0, 1e-3)
    drive = np.array([4.0, 4.0, 4.0, 1.5, 1.5, 1.5, 1.6])
    expected, value = [1.0], 1.0
    for command in drive[:-1]:
        value = float(_approach(value, command, 1e-3, 1 / (60 * math.pi), 100.0))
        expected.append(value)
    np.testing.assert_allclose(run.amplified(drive), expected, rtol=1e-12)
    quick = _MirrorState(BenchMirror(), Amplifier(30.0, 1e6), 1.0, 1e-3).amplified(drive)
    share = 1 - math.exp(-0.06 * math.pi)
    expected = [1.0]
    for command in drive[:-1]:
        expected.append(expected[-1] + share * (command - expected[-1]))
    np.testing.assert_allclose(quick, expected, rtol=1e-12)


@pytest.mark.parametrize(
    ("moving", "runs"),
    [
        ("1", [(0, 1, True)]),
        ("0011", [(0, 2, False), (2, 4, True)]),
        ("10010", [(0, 1, True), (1, 3, False), (3, 4, True), (4, 5, False)]),
        ("000", [(0, 3, False)]),
    ],
)
def test_runs_of_a_record_follow_each_other_to_its_end(moving, runs):
    assert _stretches(np.array([each == "1" for each in moving])) == runs


@pytest.mark.parametrize("bandwidth_hz", [1.0, 159.154943, 5e3])
def test_the_time_constant_of_an_amplifier_is_that_of_its_corner(bandwidth_hz):
    assert Amplifier(bandwidth_hz, 7.0).time_constant_s == pytest.approx(
        1 / (6.283185307179586 * bandwidth_hz), rel=1e-12
    )


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_an_amplifier_slews_up_and_down_alike(side):
    """A step of 2 V, of which 1 V takes 10 ms at 100 V/s, and then an exponential of 10 ms is left of the other."""
    run = _MirrorState(BenchMirror(), Amplifier(1 / (0.02 * math.pi), 100.0), 5.0, 5e-3)
    volts = run.amplified(np.full(5, 5.0 + 2.0 * side))
    left = [2.0, 1.5, 1.0, math.exp(-0.5), math.exp(-1.0)]
    np.testing.assert_allclose(volts, 5.0 + side * (2.0 - np.array(left)), rtol=1e-12)


@pytest.mark.parametrize(("rest_v", "command_v"), [(-1.0, 1.0), (1.0, -1.0), (-30.5, -28.5)])
def test_an_amplifier_slews_by_how_far_it_has_to_go_wherever_it_rests(rest_v, command_v):
    """2 V, of which the first takes 10 ms at 100 V/s; a command near 0 V is as far away as any other."""
    run = _MirrorState(BenchMirror(), Amplifier(1 / (0.02 * math.pi), 100.0), rest_v, 5e-3)
    left = np.array([2.0, 1.5, 1.0, math.exp(-0.5), math.exp(-1.0)])
    expected = command_v + (rest_v - command_v) * left / 2.0
    np.testing.assert_allclose(run.amplified(np.full(5, command_v)), expected, rtol=0, atol=1e-12)


@pytest.mark.parametrize("z", [-0.0099, -0.0101, -1e-9, -0.007 + 0.0069j, -0.5 + 2.0j])
@pytest.mark.parametrize("step_s", [2.5e-6, 40.0])
def test_a_step_of_a_line_keeps_its_digits_where_it_is_short(z, step_s):
    """Of the sums of z^k / (k + 1)! and z^k / (k + 2)!, which cancel nowhere."""
    decay, start, end = _straight_line(np.array(z / step_s), step_s)
    held, ramp = (sum(z**k / math.factorial(k + more) for k in range(30)) for more in (1, 2))
    assert complex(decay) == pytest.approx(1.0 + z * held, rel=1e-12)
    assert complex(end) == pytest.approx(step_s * ramp, rel=1e-12)
    assert complex(start) == pytest.approx(step_s * (held - ramp), rel=1e-12)
