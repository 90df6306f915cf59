"""One mirror for all amplitudes: exact derivatives, recovery of a known mirror, the real CubeSpec mirror, refusals."""

import itertools
import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from microrad.core import kernels
from microrad.core.periodic import delayed
from microrad.lab import identify
from microrad.lab.identify import fit_hysteretic_stiffness, fit_linear, output_error, predicted_error
from microrad.lab.identify.linear.modal import ModalModel
from microrad.lab.identify.linear.response import response_from_periods
from microrad.lab.identify.records import IdentificationError
from microrad.lab.identify.stiffness import fit as fit_of
from microrad.lab.identify.stiffness import model as model_of
from microrad.lab.identify.stiffness import search as search_of
from microrad.lab.identify.stiffness import springs as springs_of
from microrad.lab.identify.stiffness import tangents
from microrad.lab.identify.stiffness.fit import (
    StiffnessOptions,
    _expected_squares,
    _few,
    _further,
    _in_si,
    _middle,
    _pole_errors,
    amplitude_classes,
    simulate_hysteretic_stiffness,
    trust,
)
from microrad.lab.identify.stiffness.gradient import squared_error_slope
from microrad.lab.identify.stiffness.model import LinearStart, Numbers, scaled
from microrad.lab.identify.stiffness.search import Search
from microrad.lab.recording import Recording, multisine_recordings
from microrad.mirror import coupled
from microrad.mirror import model as mirror
from microrad.mirror.hysteresis import PrandtlIshlinskii
from microrad.mirror.model import Mirror
from places import DATA, ROOT, benchmark

CUBESPEC = DATA / "cubespec"
needs_cubespec = pytest.mark.skipif(not CUBESPEC.exists(), reason=f"real recording cubespec absent: {CUBESPEC}")
RATE_HZ, PERIOD = 1000.0, 512
AMPLITUDES = 0.3, 0.6, 1.2


def philox(seed):
    return np.random.Generator(np.random.Philox(seed))


def multisine(seed, inputs=2, period=PERIOD, lines=200):
    """Random-phase multisine of unit rms, shape (period, inputs)."""
    phases = philox(seed).uniform(0, 2 * np.pi, (lines, inputs))
    spectrum = np.zeros((period // 2 + 1, inputs), dtype=complex)
    spectrum[1 : lines + 1] = np.exp(1j * phases)
    drive = np.fft.irfft(spectrum, period, axis=0)
    return drive / drive.std(axis=0)


# ---------------------------------------------------------------------------------------------------------- derivatives
@pytest.fixture(scope="module")
def numbers():
    """A pair and two real poles, two inputs, two outputs, four operators of three plays."""
    draw = philox(0).standard_normal
    return Numbers(
        decay=np.array([-30.0, -50.0, -100.0]),
        frequency=np.array([600.0]),
        B=100 * draw((4, 2)),
        E=20 * draw((4, 4)),
        F=0.5 * draw((4, 4)),
        G=draw((4, 2)),
        weights=0.2 * draw((4, 3)),
        polynomial=0.1 * draw((4, 3)),
        C=draw((2, 4)),
        D=0.1 * draw((2, 2)),
        K=0.1 * draw((2, 4)),
        thresholds=np.array([[0.0, 0.3, 0.9], [0.1, 0.4, 0.8], [0.2, 0.5, 1.0], [0.3, 0.6, 1.2]]),
        reach=np.array([1.0, 2.0, 3.0, 1.5]),
        delay_s=3e-4,
    )


def test_changes_of_the_decays_of_pairs_and_real_poles_are_turned_for_a_mirror_file(numbers):
    size = numbers.vector().size
    turned = np.ones(size)
    turned[:3] = -1.0
    np.testing.assert_allclose(_in_si(numbers, np.eye(size), (1.0, 1.0)), np.diag(turned))


STEADY = tangents.Steady("record", multisine(3), np.zeros((PERIOD, 2)), RATE_HZ, 2)


def path_of(numbers):
    plant = tangents.play_plant(numbers, STEADY.step_s)
    drive = tangents.two_periods(STEADY, numbers.delay_s)
    return plant, drive, tangents.simulate_path(plant, drive)


@pytest.mark.promise("hysteretic-stiffness-1", "hysteretic-stiffness-3")
def test_the_path_is_that_of_the_open_loop(numbers):
    _, drive, path = path_of(numbers)
    plant = mirror.discretise(numbers.mirror("m"), STEADY.step_s)
    output, bank = np.empty_like(path.output), np.empty_like(path.z)
    kernels.open_loop(plant, mirror.at_rest(plant), drive, output, bank)
    assert np.abs(path.output).max() > 1.0
    np.testing.assert_allclose(path.output, output, rtol=0, atol=1e-9)
    np.testing.assert_allclose(path.z, bank, rtol=0, atol=1e-9)
    assert (path.moved[:, 0] >= 1).all()  # a threshold of zero always moves
    assert {0, 1, 2, 3} == set(np.unique(path.moved[:, 1]))


@pytest.mark.promise("hysteretic-stiffness-11")
def test_tangents_against_differences(numbers):
    plant, drive, path = path_of(numbers)
    exact = tangents.jacobian(plant, numbers, STEADY, (path, drive), np.float64, lead=PERIOD)
    single = tangents.jacobian(plant, numbers, STEADY, (path, drive), np.float32, lead=PERIOD)
    vector = numbers.vector()
    assert exact.shape == (PERIOD, 2, vector.size)
    for i, value in enumerate(vector):
        step = np.zeros(vector.size)
        step[i] = 1e-9 if i == vector.size - 1 else 1e-6 * max(abs(value), 1e-3)
        above, below = (path_of(numbers.at(vector + sign * step))[2].output for sign in (1, -1))
        expected = ((above - below) / (2 * step[i]))[2 * PERIOD :: 2]
        size = np.abs(expected).max()
        assert size > 0
        away = np.linalg.norm(exact[:, :, i] - expected)  # differences err where a play starts or stops
        assert away < 3e-4 * np.linalg.norm(expected)
        np.testing.assert_allclose(single[:, :, i], exact[:, :, i], rtol=0, atol=2e-5 * size)


@pytest.mark.promise("hysteretic-stiffness-11")
def test_the_gradient_is_that_of_the_derivatives_and_of_differences(numbers):
    """From one pass back along the path; a real record has an error, and here it is the whole output."""
    record = replace(STEADY, output=philox(4).standard_normal((PERIOD, 2)))
    record = replace(record, output=record.output - record.output.mean(axis=0))
    plant, drive, path = path_of(numbers)
    cost, gradient = squared_error_slope(plant, numbers, record)
    error = path.output[2 * PERIOD :: 2] - record.output
    error -= error.mean(axis=0)
    assert cost == pytest.approx(np.sum(error**2), rel=1e-12)
    J = tangents.jacobian(plant, numbers, record, (path, drive), np.float64, lead=PERIOD)
    expected = 2 * np.einsum("koi,ko->i", J, error)
    np.testing.assert_allclose(gradient[:-1], expected[:-1], rtol=1e-8, atol=1e-8 * np.abs(expected).max())
    assert gradient[-1] == pytest.approx(expected[-1], rel=1e-4)  # of the delay: J's is a difference

    def cost_at(vector):
        trial = numbers.at(vector)
        return tangents.squared_error(tangents.play_plant(trial, record.step_s), record, trial.delay_s)

    vector = numbers.vector()
    for i in range(0, vector.size, 7):
        step = np.zeros(vector.size)
        step[i] = 1e-6 * max(abs(vector[i]), 1e-3)
        difference = (cost_at(vector + step) - cost_at(vector - step)) / (2 * step[i])
        assert gradient[i] == pytest.approx(difference, rel=1e-4, abs=1e-6 * np.abs(expected).max())


@pytest.mark.promise("hysteretic-stiffness-11")
def test_the_curvature_of_a_search_is_near_that_of_all_samples(numbers):
    """From half of the period, scaled; both halves are not the same. Numbers that are not wanted have none."""
    plant = tangents.play_plant(numbers, STEADY.step_s)
    wanted = np.arange(numbers.vector().size) % 3 > 0
    whole = tangents.normal_equations(plant, numbers, STEADY).matrix
    halves = [tangents.curvature(plant, numbers, STEADY, end, 0.5, wanted) for end in (0.5, 1.0)]
    for rough in halves:
        ratio = np.diag(rough) / np.diag(whole)[wanted]
        assert 0.3 < ratio.min() < 1.0 < ratio.max() < 3.0
    both = np.diag(sum(halves) / 2) / np.diag(whole)[wanted]
    assert not np.allclose(*halves) and 0.7 < both.min() < both.max() < 1.5


def test_tangents_begin_early_enough_for_the_slowest_mode(numbers):
    """Seven of its time constants, where the period has them: what is left out has decayed to a thousandth."""
    slow = replace(numbers, decay=np.array([-3e4, -150.0, -4e4]))
    plant, drive, path = path_of(slow)
    whole = tangents.jacobian(plant, slow, STEADY, (path, drive), np.float64, lead=PERIOD)
    short = tangents.jacobian(plant, slow, STEADY, (path, drive), np.float64)
    missed = np.linalg.norm(short - whole, axis=(0, 1)) / np.linalg.norm(whole, axis=(0, 1))
    assert 0.0 < np.max(missed) < 3e-3


@pytest.mark.promise("hysteretic-stiffness-5")
def test_poles_at_rest_have_the_plays_that_never_stick_in_them_and_errors_of_their_own(numbers):
    stuck = replace(numbers, thresholds=numbers.thresholds + 0.1)
    np.testing.assert_allclose(stuck.poles_at_rest, [-30 + 600j, -100, -50])
    moved = np.zeros((2, numbers.vector().size))
    moved[0, :4], moved[1, 3] = (1.0, 2.0, 3.0, 4.0), 3.0  # decays, the frequency
    np.testing.assert_allclose(_pole_errors(stuck, moved), [1 + 5j, 3, 2], rtol=1e-6)
    own = numbers.mirror("m")
    gains = np.array([numbers.weights[0, 0], 0.0, 0.0, 0.0])
    expected = np.linalg.eigvals(own.A + own.E @ np.diag(gains) @ own.F)
    assert np.abs(numbers.poles_at_rest - stuck.poles_at_rest).max() > 0.1
    assert np.abs(numbers.poles_at_rest[:, None] - expected[None, :]).min(axis=1).max() < 1e-9
    assert np.isnan(_pole_errors(numbers, None)).all()


def test_other_units_of_drive_and_output_change_nothing_else(numbers):
    plain = path_of(numbers)[2].output
    wide = replace(STEADY, drive=10 * STEADY.drive)
    plant = tangents.play_plant(scaled(numbers, 10.0, 3.0), STEADY.step_s)
    output = tangents.simulate_path(plant, tangents.two_periods(wide, numbers.delay_s)).output
    np.testing.assert_allclose(output, 3 * plain, rtol=0, atol=1e-10)


@pytest.mark.promise("mirror-file-36", "hysteretic-stiffness-3")
def test_the_interpolated_drive_is_late_and_passes_through_the_samples():
    drive = multisine(5)
    fine = delayed(drive, RATE_HZ, 2 / RATE_HZ, 4)
    np.testing.assert_allclose(fine[8::4], drive[:-2], atol=1e-12)
    assert np.abs(fine[::4] - drive).max() > 0.1


# ------------------------------------------------------------------------------------------------------- a known mirror
def hysteretic_truth():
    """Two modes, two channels; each actuator is a spring that softens by plays of its own strain."""
    poles = np.array([-18.0 + 900.0j, -34.0 + 1700.0j])
    A = np.zeros((4, 4))
    for k, p in enumerate(poles):
        A[2 * k : 2 * k + 2, 2 * k : 2 * k + 2] = [[p.real, -p.imag], [p.imag, p.real]]
    force = np.array([[0.9, 0.8], [0.0, 0.0], [0.7, -0.8], [0.0, 0.0]])
    B, strain = 700.0 * force, np.roll(force, 1, axis=0).T  # an actuator is stretched where it pushes
    C = np.array([[0.0, 1.0, 0.0, 0.7], [0.0, 0.8, 0.0, -0.8]])
    weights = (0.02, 0.02, 0.02, 0.02)
    plays = tuple(PrandtlIshlinskii((0.1, 0.3, 0.8, 2.0), tuple(s * w for w in weights)) for s in (1.0, 0.8))
    idle = PrandtlIshlinskii((1.0,), (0.0,))  # as many operators as the fit has: then the kernel compiles once
    E, F, G = np.hstack([B, B]), np.vstack([strain, strain]), np.zeros((4, 2))
    return Mirror("truth", A, B, E, F, G, C, np.zeros((2, 2)), np.zeros((2, 4)), (), (*plays, idle, idle), ())


def record_of(truth, amplitude, seed, delay_s=7e-4):
    """Two periods in the steady state, with fine steps of its own and little noise."""
    drive = amplitude * multisine(seed)
    fine = delayed(np.tile(drive, (4, 1)), RATE_HZ, delay_s, 8)
    plant = mirror.discretise(truth, 1 / (8 * RATE_HZ))
    output = np.empty_like(fine)
    kernels.open_loop(plant, mirror.at_rest(plant), fine, output, np.empty((fine.shape[0], 0)))
    output = output[16 * PERIOD :: 8] + 1e-4 * amplitude * philox(1000 + seed).standard_normal((2 * PERIOD, 2))
    names = ("u0", "u1"), ("y0", "y1")
    return Recording(f"{amplitude:g} V, {seed}", "", np.tile(drive, (2, 1)), output, RATE_HZ, *names, PERIOD)


@pytest.fixture(scope="module")
def training():
    truth = hysteretic_truth()
    return [record_of(truth, amplitude, 10 * i + k) for i, amplitude in enumerate(AMPLITUDES) for k in range(3)]


@pytest.fixture(scope="module")
def known(training):
    steps = []
    fit = fit_hysteretic_stiffness(
        training,
        order=4,
        options=StiffnessOptions(sub_steps=4),
        iterations=25,
        on_progress=lambda done, total, text: steps.append((done, total)),
    )
    return fit, steps


@pytest.fixture(scope="module")
def straight(training):
    """Linear models: of all records and of those of the middle amplitude."""
    middle = [r for r in training if r.path.startswith("0.6")]
    return fit_linear(training, 4, exchanges=0), fit_linear(middle, 4, exchanges=0)


def rms(values):
    return float(np.sqrt(np.mean(values**2)))


@pytest.mark.promise("hysteretic-stiffness-3", "hysteretic-stiffness-10", "hysteretic-stiffness-11")
def test_a_known_mirror_is_recovered(known, training):
    fit, steps = known
    assert fit.order == 4 and fit.mirror.A.shape == (4, 4)
    assert all(b > a for (a, _), (b, _) in itertools.pairwise(steps))
    assert steps[-1] == (15 + fit.iterations, 40)
    assert fit.amplitudes == pytest.approx((0.3, 0.6, 1.2), rel=1e-6)
    assert fit.classes == (0, 0, 0, 1, 1, 1, 2, 2, 2)
    assert all(after < before for before, after in zip(fit.costs, fit.costs[1:], strict=False))
    assert (fit.error_rms < 0.3 * fit.start_error_rms).all()
    # The delay of a third of a sample is traded with what plays at other thresholds than the truth's leave.
    assert fit.delay_s == pytest.approx(7e-4, abs=0.35 / RATE_HZ) and 0 < fit.delay_error_s < 1e-4
    assert fit.poles_rad_s.imag == pytest.approx([900, 1700], rel=0.02)
    assert (fit.poles_error_rad_s.imag > 0).all() and (fit.poles_error_rad_s.imag < 20).all()
    springs, modes, plays = 4, 2, 4
    assert len(fit.mirror.plays) == springs + 2
    assert min(w for play in fit.mirror.plays for w in play.weights_rad_v[1:]) >= 0.0
    of_springs = springs * (modes + 2 + 3) + 2 * springs + plays * springs
    assert fit.parameters == 2 * modes + 4 * (2 + 2 + 2) + of_springs + 2 * (plays + 2) + 4 + 1
    assert fit.redundant == 2


@pytest.mark.promise("choose-3")
@pytest.mark.parametrize("amplitude", [0.45, 0.9])
def test_an_amplitude_between_is_predicted_far_better_than_by_a_linear_model(known, straight, amplitude):
    held_out = record_of(hysteretic_truth(), amplitude, 77)
    linear, own = (rms(output_error(fit.modes, held_out, drop=512)) for fit in straight)
    error = rms(predicted_error(known[0], held_out, drop=512))
    assert 0 < error < 0.3 * min(linear, own)
    assert linear < rms(held_out.output)


@pytest.mark.promise("hysteretic-stiffness-13")
def test_the_error_expected_of_unseen_records_is_that_of_new_ones(known):
    """On three new records of each amplitude; more than is left of those fitted, which tells too little."""
    fit, _ = known
    assert (fit.unseen_error_rms > fit.error_rms).all()
    records = [record_of(hysteretic_truth(), a, 90 + k) for a in AMPLITUDES for k in range(3)]
    found = np.array([rms(predicted_error(fit, record, PERIOD)) for record in records])
    by_amplitude = [np.sqrt(np.mean(e.reshape(3, 3) ** 2, axis=1)) for e in (fit.unseen_error_rms, found)]
    assert 0.6 < min(by_amplitude[0] / by_amplitude[1]) < max(by_amplitude[0] / by_amplitude[1]) < 1.3
    assert rms(fit.error_rms) < rms(fit.unseen_error_rms) < rms(found)


@pytest.mark.promise("hysteretic-stiffness-10")
def test_a_record_that_is_noisier_counts_less():
    """Alone as far as its own noise goes: what no linear model follows counts in all records of its amplitude."""
    quiet = [record_of(hysteretic_truth(), 0.6, k) for k in range(4)]
    noise = 1e-2 * philox(5).standard_normal(quiet[0].output.shape)
    noisy = [replace(quiet[0], output=quiet[0].output + noise), *quiet[1:]]
    before, after = (_expected_squares(records, (0,) * 4, 0) for records in (quiet, noisy))
    assert before == pytest.approx(before[0], rel=1e-3)
    own = float(np.mean((noise[:PERIOD] - noise[PERIOD:]) ** 2)) / 4
    assert after[1:] == pytest.approx(after[1]) and after[0] - after[1] == pytest.approx(own, rel=0.05)
    assert 0.5 * before[1] < after[1] < 2.0 * before[1]


@pytest.mark.promise("hysteretic-stiffness-9", "hysteretic-stiffness-26")
def test_a_fit_says_how_far_it_is_to_be_trusted(known):
    """Inside its records, and at twice their largest amplitude, where the error is a guess at what goes on there."""
    found = []
    for amplitude, within in ((0.9, 2.0), (2.4, 6.0)):
        record = record_of(hysteretic_truth(), amplitude, 78)
        own, error = trust(known[0], record.drive), rms(predicted_error(known[0], record, drop=512))
        assert own.error_rms == pytest.approx(np.hypot(own.left, own.open))
        assert error / within < own.error_rms < within * error
        found.append(own)
    inside, beyond = found
    assert 0.5 < inside.motion < 1.3 and inside.open < 0.1 * inside.left
    assert 1.6 < beyond.motion < 3.0 and beyond.open > 0.1 * beyond.left
    assert beyond.error_rms > 2 * inside.error_rms


@pytest.mark.promise("hysteretic-stiffness-28")
def test_a_large_motion_in_one_mode_softens_the_other():
    """The drives of a mode do not push the other; the plays that a slow large motion of one slides are both modes'."""
    truth, step_s = hysteretic_truth(), 1 / (8 * RATE_HZ)
    time = step_s * np.arange(16 * RATE_HZ)
    plant = mirror.discretise(truth, step_s)

    def gain(large):
        drive = np.outer(large * np.sin(2 * np.pi * 7.0 * time), [8.0, 7.0])
        drive += np.outer(1e-3 * np.sin(2 * np.pi * 41.0 * time), [8.0, -9.0])
        output = np.empty_like(drive)
        kernels.open_loop(plant, mirror.at_rest(plant), drive, output, np.empty((len(drive), 0)))
        second = (output @ [0.8, -1.0])[len(time) // 2 :]  # of what the sensors see, the second mode's part
        return abs(np.exp(-2j * np.pi * 41.0 * time[len(time) // 2 :]) @ second)

    assert gain(0.3) > 1.01 * gain(0.0)


@pytest.mark.promise("mirror-file-28")
@pytest.mark.promise("identify-41")
@pytest.mark.promise("hysteretic-stiffness-28", "hysteretic-stiffness-31")
def test_the_resonance_falls_with_the_amplitude_as_the_truth_does(known):
    """Peak of the response to a small and to a large multisine: the same for the fit and the truth."""
    truth = hysteretic_truth()

    def gains(simulate):
        found = []
        for amplitude in (0.3, 1.2):
            drive = amplitude * multisine(91)
            output = simulate(np.tile(drive, (2, 1)))[PERIOD:]
            ratio = np.fft.rfft(output @ [1, 1], axis=0)[1:30] / np.fft.rfft(drive @ [7, 6], axis=0)[1:30]
            found.append(np.abs(ratio).mean())
        return found[1] / found[0]

    def of_truth(drive):
        fine = delayed(drive, RATE_HZ, 7e-4, 8)
        plant, output = mirror.discretise(truth, 1 / (8 * RATE_HZ)), np.empty((8 * len(drive), 2))
        kernels.open_loop(plant, mirror.at_rest(plant), fine, output, np.empty((len(output), 0)))
        return output[::8]

    rise = gains(of_truth)
    assert rise > 1.01
    assert gains(lambda drive: simulate_hysteretic_stiffness(known[0], drive)) == pytest.approx(
        rise, abs=0.2 * (rise - 1)
    )


@pytest.fixture(scope="module")
def many(training):
    """Two modes too many, which a search may use for anything."""
    few = [training[k] for k in (0, 3, 4, 6, 8)]
    return fit_hysteretic_stiffness(few, order=8, options=StiffnessOptions(delay_s=7e-4, exchanges=0), iterations=20)


@pytest.mark.promise("mirror-file-39", "hysteretic-stiffness-6", "hysteretic-stiffness-7")
@pytest.mark.promise("hysteresis-23", "hysteretic-stiffness-31")
@pytest.mark.endurance
def test_no_fit_runs_away_where_its_plays_slide(many, training):
    """No combination of sliding plays grows; a thousand periods, and then ten times the drive, stay where they are."""
    m, sums = many.mirror, [sum(play.weights_rad_v) for play in many.mirror.plays]
    cases = itertools.product((0.0, 1.0), repeat=len(sums))
    growths = [np.linalg.eigvals(m.A + m.E @ np.diag(np.multiply(case, sums)) @ m.F).real.max() for case in cases]
    assert len(growths) == 1024 and max(growths) < 0.0
    assert 0.0 < many.softening <= springs_of.MOST_SOFTENING
    assert rms(many.error_rms) < 0.1 * rms(many.start_error_rms)
    drive = training[-1].drive[:PERIOD]
    first, second, last = over_periods(many, drive, 1, 2, 1000)
    assert np.abs(last - second).max() < 1e-3 * np.abs(second).max() < 1e-3 * 2 * np.abs(first).max()
    far, farther, at_rest = over_periods(many, 10 * drive, 1, 1000, 1100)
    assert np.abs(farther).max() < 1.5 * np.abs(far).max() < 30 * np.abs(first).max()
    assert np.ptp(at_rest, axis=0).max() < 1e-6 * np.abs(first).max()


def over_periods(fit, drive, *numbers):
    """Outputs over some of many periods of a drive from rest; behind the thousandth there is none."""
    plant, found = mirror.discretise(fit.mirror, 1 / (fit.sub_steps * RATE_HZ)), []
    state, fine = mirror.at_rest(plant), delayed(drive, RATE_HZ, fit.delay_s, fit.sub_steps)
    for number in range(1, numbers[-1] + 1):
        output = np.empty((len(fine), len(plant.outputs)))
        kernels.open_loop(plant, state, fine * (number <= 1000), output, np.empty((len(fine), 0)))
        found += [output] * (number in numbers)
    return found


# ------------------------------------------------------------------------------------------------------------- springs
@pytest.fixture(scope="module")
def springs():
    """Two pairs and a real pole, with five springs for two actuators and two outputs; and where their fit begins."""
    draw = philox(11).standard_normal
    poles = np.array([-90.0, -18.0 + 900.0j, -34.0 + 1700.0j])
    b, c = draw((3, 2)) + 1j * draw((3, 2)), draw((2, 3)) + 1j * draw((2, 3))
    b[0], c[:, 0] = b[0].real, c[:, 0].real
    model = ModalModel(poles, 20 * b, 20 * c, 0.1 * draw((2, 2)))
    large, middle = (replace(STEADY, drive=size * STEADY.drive) for size in (2.0, 1.0))
    start = LinearStart(model, 3e-4)
    return springs_of.begin(start, [large], [middle], 5, (0.05, 0.2, 0.5), fixed_delay=False), model, middle


@pytest.mark.promise("hysteretic-stiffness-10")
def test_light_springs_hardly_change_the_linear_model_they_stand_in(springs):
    (found, free), model, middle = springs
    numbers = found.numbers(free)
    drive = tangents.two_periods(middle, numbers.delay_s)
    output = tangents.simulate_path(tangents.play_plant(numbers, middle.step_s), drive).output[2 * PERIOD :]
    line = np.fft.rfft(drive[2 * PERIOD :], axis=0)[1:200]
    linear = np.einsum("koi,ki->ko", model.response(np.fft.rfftfreq(PERIOD, 1 / RATE_HZ)[1:200]), line)
    away = np.abs(np.fft.rfft(output, axis=0)[1:200] - linear)
    assert 0.0 < np.linalg.norm(away) < 0.05 * np.linalg.norm(linear)  # a step is straight, not free of images


@pytest.mark.promise("hysteretic-stiffness-3", "hysteretic-stiffness-5", "hysteretic-stiffness-12")
def test_each_free_number_moves_what_it_says_and_weights_leave_the_gain_alone(springs):
    found, free = springs[0]
    numbers = found.numbers(free)
    assert numbers.E.shape == (5, 7) and numbers.F.shape == (7, 5) and numbers.weights.shape == (7, 4)
    np.testing.assert_array_equal(numbers.E[0:4:2, :5], numbers.F[:5, 1:4:2].T)
    assert not numbers.E[1:4:2, :5].any() and not numbers.F[5:].any() and not numbers.F[:, 4].any()
    assert not numbers.polynomial.any()
    np.testing.assert_array_equal(numbers.G[5:], np.eye(2))
    assert set(found.kinds) == {*"BCDEGK", "decay", "frequency", "phi", "weights", "polynomial", "delay"}
    assert np.isneginf(found.least).sum() + 7 * 3 + 2 == free.size and np.isfinite(found.most).sum() == 3
    weight = np.flatnonzero(found.kinds == "weights")[0]
    more = found.numbers(free + 0.1 * (np.arange(free.size) == weight))
    change = more.weights - numbers.weights
    assert change[0, 1] == pytest.approx(0.1) and -0.1 < change[0, 0] < -0.05
    assert np.count_nonzero(change) == 2
    drive = delayed(springs[2].drive, RATE_HZ, numbers.delay_s, 2)[:, 0]
    plays = kernels.play_response(np.tile(drive, 2), numbers.thresholds[5], np.zeros(4))[len(drive) :]
    size = np.linalg.norm(plays * numbers.weights[5]) * np.linalg.norm(drive)
    assert abs((plays @ numbers.weights[5]) @ drive) < 1e-12 * size


@pytest.mark.promise("hysteretic-stiffness-12")
def test_thresholds_are_the_same_parts_of_the_largest_drive_for_all_springs_and_are_not_fitted(springs):
    """The drive counts at the steps of the plant, a delay behind its samples, so that its largest is near theirs."""
    found, free = springs[0]
    thresholds, farthest = found.numbers(free).thresholds, np.abs(2.0 * STEADY.drive).max()
    np.testing.assert_allclose(thresholds / thresholds[0, 3], np.tile([0.0, 0.1, 0.4, 1.0], (7, 1)), rtol=1e-12)
    assert thresholds[0, 3] == pytest.approx(0.5 * farthest, rel=0.1)
    others = found.numbers(free + 0.01)
    np.testing.assert_array_equal(others.thresholds, thresholds)
    scaled_by = found.numbers(np.where(found.kinds == "phi", 2.0, 1.0) * free)
    np.testing.assert_array_equal(scaled_by.F, 2.0 * found.numbers(free).F)


@pytest.mark.promise("hysteretic-stiffness-10", "hysteretic-stiffness-11")
def test_a_fit_begins_at_the_middle_amplitude_and_with_a_record_of_each(training):
    """The middle is next to the geometric mean over the records: 0.6 V, and 1.2 V where most records have it."""
    amplitudes, classes = amplitude_classes(training)
    assert amplitudes[_middle(amplitudes, classes)] == pytest.approx(0.6, rel=1e-6)
    more = [*training[:1], *training[3:4], *training[6:], *training[6:]]
    assert amplitudes[_middle(*amplitude_classes(more))] == pytest.approx(1.2, rel=1e-6)
    steady = [replace(STEADY, drive=record.drive) for record in training]
    assert _few(steady, classes) == [0, 3, 6]
    alone = [replace(r, drive=r.drive * (np.arange(2) == k % 2)) for k, r in enumerate(steady)]
    assert _few(alone, classes) == [0, 1, 3, 4, 6, 7]  # and one of each set of actuators


PAGE = (ROOT / "docs" / "hysteretic-stiffness.md").read_text(encoding="utf-8")


@pytest.mark.promise("hysteretic-stiffness-14")
def test_the_lines_of_the_page_run(known, training, monkeypatch, capsys):
    """With a fit that is there already: what is asked for, and what there is to print."""
    asked = []
    monkeypatch.setattr(identify, "fit_hysteretic_stiffness", lambda *a, **k: (asked.append((a, k)), known[0])[1])
    (code,) = re.findall(r"```python\n(.*?)```", PAGE, flags=re.DOTALL)
    found = {"recordings": training, "unseen": training[0]}
    exec(code, found)
    assert asked == [((training,), {"order": 36, "options": StiffnessOptions(springs=12)})]
    assert str(known[0].softening) in capsys.readouterr().out
    assert rms(found["error"][PERIOD:]) == pytest.approx(known[0].error_rms[0], rel=0.05)


@pytest.mark.promise("hysteretic-stiffness-13")
def test_the_benchmark_chooses_by_what_is_expected_of_unseen_records(monkeypatch, capsys):
    """The fit that is expected to leave least counts, whatever it leaves of the fold's own record."""
    bench, fitted = benchmark("cubespec_one_model"), []

    def fit(groups, order, options, iterations):
        fitted.append(([r for group in groups for r in group], order))
        expected = np.array([3e-6] * 3 if order == 28 else [2e-6] * 3)
        return SimpleNamespace(
            order=order, classes=(0, 1, 2), amplitudes=(1.0, 2.0, 3.0), unseen_error_rms=expected, iterations=1,
            converged=True, softening=0.1, parameters=10, redundant=0,
        )  # fmt: skip

    monkeypatch.setattr(bench, "fitted", fit)
    monkeypatch.setattr(bench, "scores", lambda of, groups, held: np.array([0.5 if of.order == 28 else 0.9] * 3))
    monkeypatch.setattr(bench, "predicted_error", lambda of, record, drop: np.zeros(3))
    groups = [tuple(f"{a} mV, {k}" for k in range(6)) for a in (100, 200, 300)]
    options = {"order": "28,36", "springs": "12", "thresholds": "0.02:0.4", "seen": "100,200,300", "iterations": "60"}
    np.testing.assert_array_equal(bench.fold(groups, 5, options), [0.9] * 3)
    assert "fold 5, held out" in capsys.readouterr().out
    assert [order for _, order in fitted] == [28, 36]
    assert all(len(records) == 15 and not any(r.endswith(", 5") for r in records) for records, _ in fitted)


@pytest.mark.promise("hysteretic-stiffness-17", "hysteretic-stiffness-18", "hysteretic-stiffness-23")
@pytest.mark.parametrize(("pairs", "numbers"), [(18, 760), (14, 632), (17, 770)])
def test_the_counts_of_the_page_are_those_of_such_mirrors(pairs, numbers):
    """Three actuators and sensors, twelve springs, four thresholds; 36 or 28 states, once with two real poles."""
    poles = np.array([-20.0 + 1j * w for w in np.linspace(300.0, 2400.0, pairs)] + [-70.0, -90.0] * (pairs == 17))
    draw = philox(12).standard_normal
    b, c = draw((len(poles), 3)) + 0j, draw((3, len(poles))) + 0j
    wide = replace(STEADY, drive=multisine(8, inputs=3)[:64], output=np.zeros((64, 3)))
    start = LinearStart(ModalModel(poles, b, c, np.zeros((3, 3))), 0.0)
    found, free = springs_of.begin(start, [wide], [wide], 12, (0.02, 0.06, 0.15, 0.4), fixed_delay=False)
    assert found.mirror.B.shape[0] == (28 if pairs == 14 else 36)
    assert free.size - found.redundant == numbers


@pytest.mark.promise("hysteretic-stiffness-6", "hysteretic-stiffness-7")
@pytest.mark.promise("hysteresis-23", "hysteretic-stiffness-31")
@pytest.mark.parametrize("softening", [*(pytest.param(s, marks=pytest.mark.endurance) for s in (0.05, 0.5)), 0.89])
def test_springs_never_gain_energy(springs, softening):
    """The energy of the docstring falls along every free path, and its stiffness is above zero."""
    found, free = springs[0]
    draw = philox(int(100 * softening))
    trial = np.where(found.kinds == "weights", draw.uniform(0.0, 0.2, free.size), free)
    trial += (found.kinds == "polynomial") * 0.05 * draw.standard_normal(free.size)
    trial *= np.where(found.kinds == "phi", draw.uniform(0.3, 3.0, free.size), 1.0)
    raised = np.isin(found.kinds, ("weights", "polynomial"))

    def at(times):
        return found.numbers(np.where(raised, times * trial, trial))

    high = low = 1e-9
    while found.softening(at(high)) < softening:
        low, high = high, 2 * high
    for _ in range(60):
        mean = (low + high) / 2
        low, high = (mean, high) if found.softening(at(mean)) < softening else (low, mean)
    numbers = replace(at(low), B=np.zeros_like(free[:1], shape=(5, 2)), G=np.zeros((7, 2)))
    assert found.softening(numbers) == pytest.approx(softening, rel=1e-6)
    energies = free_energies(numbers, 5, 4 * draw.standard_normal(5))
    assert energies.size == 4000 and energies[0] > 0
    assert np.diff(energies).max() < 1e-6 * energies[0]
    assert energies[-1] < 0.8 * energies[0]


def free_energies(numbers, count, state):
    """Energy of the modes and springs at steps of 2 us from a state with all plays at rest, without a drive."""
    m, step_s, pairs = numbers.mirror("m"), 2e-6, numbers.frequency.size
    w, k = numbers.frequency, (numbers.decay[:pairs] ** 2 + numbers.frequency**2) / numbers.frequency
    sums, r = numbers.weights, numbers.thresholds
    start = state.copy()
    q0 = m.F @ start
    play = np.clip(0.0, q0[:, None] - r, q0[:, None] + r)
    found = []

    def output(q, play):
        s = np.clip(q / numbers.reach, -1, 1)
        powers = np.stack([s**2, np.abs(s) * s, s**3], axis=1)
        return np.sum(sums * play, axis=1) + np.sum(numbers.polynomial * powers, axis=1)

    def slope(x, play):
        q = m.F @ x
        now = np.clip(play, q[:, None] - r, q[:, None] + r)
        return m.A @ x + m.E @ output(q, now), now

    x = start
    for _ in range(4000):
        first, now = slope(x, play)
        second, play_end = slope(x + step_s * first, now)
        x, play = x + step_s * (first + second) / 2, play_end
        q = (m.F @ x)[:count]
        s = np.clip(q / numbers.reach[:count], -1, 1)
        beyond = np.abs(q) - numbers.reach[:count] * np.abs(s)
        c1, c2, c3 = numbers.polynomial[:count].T
        potential = numbers.reach[:count] * (c1 * s**3 / 3 + c2 * np.abs(s) ** 3 / 3 + c3 * s**4 / 4)
        potential += beyond * (c1 * np.sign(q) + c2 + c3)
        stop = q[:, None] - play[:count]
        stored = np.sum(sums[:count] * (q[:, None] ** 2 - stop**2)) / 2 + potential.sum()
        rate = (m.A @ x)[1 : 2 * pairs : 2]
        found.append(np.sum(rate**2 / w + k * x[1 : 2 * pairs : 2] ** 2) / 2 - stored)
    return np.array(found)


@pytest.mark.promise("hysteretic-stiffness-11")
def test_a_step_that_meets_a_limit_is_the_best_within_it():
    """Of two numbers that nearly do the same the first cannot fall far: the second is not to make up for its whole way.

    Least of g d + d H d / 2 with d at least (-0.1, -inf), damped by 1e-9: d = (-0.1, 1 + 0.9 * 0.1).
    """
    least, most = np.array([0.0, -np.inf]), np.full(2, np.inf)
    two = springs_of.Springs(None, 0, np.eye(2), np.zeros(2), np.array(["weights", "phi"]), least, most)
    search = Search(two, [], np.ones(0), [], None)
    free, slope, size = np.array([0.1, 5.0]), np.array([1.0, -1.0]), np.ones(2)
    curvature = np.array([[1.0, 0.9], [0.9, 1.0]])
    move, damping = search._bounded_step(free, slope, (curvature, size, []), 1e-9)
    assert move == pytest.approx([-0.1, 1.09], rel=1e-6) and damping == 1e-9
    scaled_by = np.array([10.0, 0.5])
    curvature = curvature / np.outer(scaled_by, scaled_by)
    other, _ = search._bounded_step(free, slope, (curvature, scaled_by, []), 1e-9)
    assert other == pytest.approx([-0.1, 1.09], rel=1e-6)


@pytest.mark.promise("hysteretic-stiffness-11")
def test_few_records_first_lead_nearly_as_far(training):
    """A step on one record of each amplitude costs less, and most of the error is gone after four."""
    options = StiffnessOptions(delay_s=7e-4, exchanges=0, few_first=4)
    steps = []
    fit = fit_hysteretic_stiffness(
        training, order=4, options=options, iterations=1, on_progress=lambda done, total, _: steps.append((done, total))
    )
    assert steps[-1] == (5, 5) and len(steps) == 5
    assert fit.iterations == 1 and fit.moved.shape == (9, len(fit.names))
    assert rms(fit.error_rms) < 0.5 * rms(fit.start_error_rms)
    assert fit.names[-1] == "recording.delay" and (fit.moved[:, -1] == 0.0).all()


def of_siso(model, truth, lines=200):
    """Springs in a linear model of one input and one output, and their numbers."""
    records = [replace(STEADY, drive=size * STEADY.drive[:, :1], output=STEADY.output[:, :1]) for size in (2.0, 1.0)]
    return springs_of.begin(LinearStart(model, 0.0), records[:1], records[1:], truth, (0.1, 0.5), fixed_delay=True)


def siso(poles, size=20.0):
    count = len(poles)
    return ModalModel(np.array(poles), np.full((count, 1), size + 0j), np.full((1, count), size + 0j), np.zeros((1, 1)))


@pytest.mark.promise("hysteretic-stiffness-4")
def test_springs_stand_on_pairs_in_the_recorded_band_alone():
    """A real pole and a pair above half of the sample rate stand for a delay: springs push them, and no more."""
    found, free = of_siso(siso([-70.0, -20 + 900j, -3000 + 9000j]), 3)
    numbers = found.numbers(free)
    np.testing.assert_array_equal(numbers.F[:3].any(axis=0), [False, True, False, False, False])
    moved = found.numbers(free + (found.kinds == "E"))
    np.testing.assert_array_equal((moved.E - numbers.E)[:, 0], [0, 0, 1, 1, 1])
    assert found.redundant == 1 + 1 + 2
    weights = numbers.weights[:3, 1]
    assert len(set(weights.tolist())) == 3  # springs of one shape are told apart
    for poles in ([-70.0, -90.0], [-3000 + 9000j]):
        with pytest.raises(
            IdentificationError, match=r"order 2 has no pair of poles below 500 Hz .* fit a larger order"
        ):
            of_siso(siso(poles), None)
    assert of_siso(siso([-20 + 900j]), None)[0].count == 2


def test_a_start_of_small_modes_is_soft_enough():
    """Springs are scaled by how far they move, so that a mode that hardly moves would have given way at once."""
    for size in (20.0, 0.05):
        found, free = of_siso(siso([-20 + 900j, -30 + 1500j], size), 4)
        assert 0.0 < found.softening(found.numbers(free)) < 0.0201


@pytest.mark.promise("hysteretic-stiffness-5")
def test_an_actuator_that_rests_at_the_middle_amplitude_has_no_gain_there(springs):
    """Its plays and powers count in full; nothing is divided by how far it moved."""
    model, drive = springs[1], STEADY.drive * np.array([1.0, 0.0])
    large, middle = replace(STEADY, drive=2.0 * STEADY.drive), replace(STEADY, drive=drive)
    found, free = springs_of.begin(LinearStart(model, 3e-4), [large], [middle], 2, (0.2,), fixed_delay=False)
    assert np.isfinite(found.matrix).all()
    numbers = found.numbers(free)
    assert -numbers.weights[2, 1] < numbers.weights[2, 0] < 0.0 and numbers.weights[3, 0] == 0.0


def test_actuators_that_are_driven_one_at_a_time(training):
    """Each has records of its own; the search begins with one of each amplitude and actuator."""
    truth, alone = hysteretic_truth(), []
    for k, (amplitude, actuator) in enumerate(itertools.product((0.4, 1.2), range(2))):
        for seed in (0, 1):
            drive = amplitude * multisine(20 * k + seed) * (np.arange(2) == actuator)
            fine = delayed(np.tile(drive, (4, 1)), RATE_HZ, 7e-4, 8)
            plant, output = mirror.discretise(truth, 1 / (8 * RATE_HZ)), np.empty_like(fine)
            kernels.open_loop(plant, mirror.at_rest(plant), fine, output, np.empty((len(fine), 0)))
            path = f"{amplitude:g} V, {actuator}, {seed}"
            kept = output[16 * PERIOD :: 8], RATE_HZ, ("u0", "u1"), ("y0", "y1"), PERIOD
            alone.append(Recording(path, "", np.tile(drive, (2, 1)), *kept))
    began = LinearStart(fit_linear(training[3:6], 4, exchanges=0).modes, 0.0)
    fit = fit_hysteretic_stiffness(alone, options=StiffnessOptions(few_first=5), start=began, iterations=2)
    assert rms(fit.error_rms) < 0.5 * rms(fit.start_error_rms)
    assert np.isfinite(fit.moved).all() and fit.moved.shape[0] == 8


def test_a_single_record_of_each_amplitude_has_no_errors(training):
    options = StiffnessOptions(delay_s=7e-4, exchanges=0, few_first=0)
    began = LinearStart(fit_linear(training[3:6], 4, exchanges=0).modes, 7e-4)
    fit = fit_hysteretic_stiffness([training[0], training[6]], options=options, iterations=2, start=began)
    assert fit.moved is None and np.isnan(fit.delay_error_s) and np.isnan(fit.poles_error_rad_s.imag).all()
    assert fit.iterations == 2 and fit.costs[-1] < fit.costs[0]
    assert not fit.converged


def test_a_search_that_ends_at_the_largest_softening_has_not_converged(training, monkeypatch):
    options = StiffnessOptions(delay_s=7e-4, exchanges=0, few_first=0)
    began = LinearStart(fit_linear(training[3:6], 4, exchanges=0).modes, 7e-4)
    monkeypatch.setattr(Search, "minimise", lambda self, free, *rest: free)
    for share, converged in ((0.99, True), (-1.0, False)):
        monkeypatch.setattr(fit_of, "_AT_LIMIT", share)
        fit = fit_hysteretic_stiffness(training, options=options, iterations=1, start=began)
        assert fit.converged is converged
    assert fit.start_error_rms == pytest.approx(fit.error_rms, rel=1e-9)  # the search goes nowhere


def test_a_delay_that_is_given_is_kept(training):
    options = StiffnessOptions(delay_s=5e-4, few_first=1, exchanges=0)
    fit = fit_hysteretic_stiffness(training, order=4, options=options, iterations=1)
    assert fit.delay_s == 5e-4 and fit.delay_error_s == 0
    assert fit.iterations == 1 and not fit.converged


# ------------------------------------------------------------------------------------------------------------- CubeSpec
def rows_of(heading):
    """The rows of a table of the page: the first cell, and the numbers in the others."""
    return dict(lines_of(heading))


def lines_of(heading):
    lines = itertools.takewhile(lambda line: line.startswith("|"), PAGE.partition(heading)[2].splitlines()[1:])
    for line in lines:
        name, *cells = (cell.strip(" *") for cell in line.strip("|").split("|"))
        yield name, [float(cell) if cell else None for cell in cells]


FOLDS = "| held out | 100 mV | 200 mV | 300 mV |\n"
BANDS = "| 300 mV: model | linear | noise |\n"


@pytest.mark.promise(
    "hysteretic-stiffness-17", "hysteretic-stiffness-18", "hysteretic-stiffness-22", "hysteretic-stiffness-20"
)
def test_the_figures_of_the_page_belong_together():
    folds = rows_of(FOLDS)
    each = np.array([folds[f"fold {k}"] for k in range(6)])
    np.testing.assert_allclose(folds["mean of six"], each.mean(axis=0), rtol=0, atol=1e-4)
    assert "The mean of the other four folds is 0.070, 0.094 and 0.139 µm" in PAGE
    np.testing.assert_allclose(each[1:5].mean(axis=0), [0.070, 0.094, 0.139], rtol=0, atol=1e-3)
    assert (np.array(folds["mean of six"]) < folds["best published model, neural, on other records"]).all()
    bands = {name: np.reshape(cells, (3, 3)) for name, cells in rows_of(BANDS).items()}
    whole, parts = bands.pop("all"), np.array(list(bands.values()))
    np.testing.assert_allclose(np.sqrt(np.sum(parts**2, axis=0)), whole, rtol=0, atol=2.5e-3)  # of nine rounded ones
    assert (parts[:8, 0, 0] < parts[:8, 0, 1]).all()  # 100 mV: below linear in every band that is driven
    above = parts[:, :, 0] - parts[:, :, 1] > 0.0011
    assert not above[:6].any() and above[6:, 1:].all()
    excess = np.sqrt(np.sum(parts[6:, 1:, 0] ** 2 - parts[6:, 1:, 1] ** 2, axis=0))
    np.testing.assert_allclose(excess, [0.037, 0.057], rtol=0, atol=2e-3)
    np.testing.assert_allclose(whole[:, 2] ** 2 / whole[:, 1] ** 2, 0.01, atol=0.006)
    assert whole[2, 0] == pytest.approx(whole[2, 1], rel=0.05)


@pytest.fixture(scope="module")
def cubespec():
    """The six realisations of each amplitude."""
    bench = benchmark("cubespec")
    return bench, bench.realisations()


@pytest.mark.promise(
    "hysteretic-stiffness-17", "hysteretic-stiffness-19", "hysteretic-stiffness-21", "hysteretic-stiffness-25"
)
@needs_cubespec
@pytest.mark.promise("hysteretic-stiffness-30")
def test_what_the_recordings_of_cubespec_say_without_a_fit(cubespec):
    """Limits of linear models, noise, periods that differ, and the responses of two amplitudes beside the third."""
    _, groups = cubespec
    assert [(len(group), group[0].drive.shape[1], group[0].output.shape[1]) for group in groups] == [(6, 3, 3)] * 3
    for group, volts in zip(groups, (0.1, 0.2, 0.3), strict=True):
        assert np.mean([record.drive.std(axis=0) for record in group]) == pytest.approx(volts, rel=0.02)
        assert response_from_periods(group[:5], skip_periods=0).freq_hz[-1] == pytest.approx(2999.0, abs=0.5)
    limit = rows_of(FOLDS)["what no linear model of one amplitude could follow, rms"]
    told = {name: np.reshape(cells, (3, 3)) for name, cells in rows_of(BANDS).items()}
    edges = benchmark("cubespec_residual").EDGES_HZ
    assert [f"{a:.0f} to {b:.0f} Hz" for a, b in itertools.pairwise(edges)] == ["0 to 500 Hz", *list(told)[1:-1]]
    responses = []
    for k, group in enumerate(groups):
        response = response_from_periods(group[:5], skip_periods=0)
        responses.append(response)
        first, second = group[5].output.reshape(2, -1, 3)
        at = np.fft.rfftfreq(len(first), 1 / 6400.0)
        noise = 2 * np.abs(np.fft.rfft(second - first, axis=0) / len(first)) ** 2 / 4
        assert 1e6 * np.sqrt(response.residual_power.sum(axis=0).mean()) == pytest.approx(limit[k], abs=5e-4)
        for (low, high), name in zip(itertools.pairwise(edges), told, strict=False):
            inside = (response.freq_hz >= low) & (response.freq_hz < high)
            linear = response.residual_power[inside].sum(axis=0).mean()
            own = noise[(at >= low) & (at < high)].sum(axis=0).mean()
            np.testing.assert_allclose(1e6 * np.sqrt([linear, own]), told[name][k, 1:], rtol=0, atol=6e-4)
    apart = [1e6 * rms(np.subtract(*r.output.reshape(2, -1, 3))) for r in groups[0]]
    np.testing.assert_allclose(apart[1:3], [0.11, 0.10], atol=5e-3)
    assert min(apart) > 0.01 and max(apart[:1] + apart[3:]) < 0.03
    shares = {}
    for low, high in itertools.pairwise(edges[:-1]):
        used = (responses[0].freq_hz >= low) & (responses[0].freq_hz < high)
        small, middle, large = (r.response[used].ravel() for r in responses)
        weight = (np.conj(large - small) @ (middle - small)).real / np.sum(np.abs(large - small) ** 2)
        shares[low] = float(weight)
    assert shares[0.5] == pytest.approx(0.4, abs=0.05)
    assert 0.55 < shares[500.0] < 0.65 and max(shares.values()) < 0.7


@pytest.mark.promise("hysteretic-stiffness-17", "hysteretic-stiffness-20", "hysteretic-stiffness-21")
@pytest.mark.endurance
@needs_cubespec
@pytest.mark.promise("hysteretic-stiffness-30")
def test_fold_5_of_cubespec_leaves_what_the_page_says(cubespec):
    """The whole fit, minutes long. A search ends where eight steps gain less than a hundredth of the error, before its
    optimum, and rounding leads it there on another path: a few such hundredths are let pass.
    """
    bench, groups = cubespec
    one_model, residual = benchmark("cubespec_one_model"), benchmark("cubespec_residual")
    fit = fit_hysteretic_stiffness(bench.all_but(groups, 5), order=36, options=StiffnessOptions(springs=12))
    assert fit.parameters - fit.redundant == 760
    assert one_model.scores(fit, groups, 5) == pytest.approx(rows_of(FOLDS)["fold 5"], rel=0.05)
    left = [residual.left(fit, group, 5)[0][1:] for group in groups]
    found = [1e6 * np.sqrt(np.mean(np.sum(power, axis=0))) for power in left]
    assert found == pytest.approx(rows_of(BANDS)["all"][::3], rel=0.05)


@pytest.mark.promise("hysteretic-stiffness-24", "hysteretic-stiffness-26")
@pytest.mark.endurance
@needs_cubespec
@pytest.mark.parametrize(("seen", "left_um"), [((0, 2), (None, 0.141, 0.125)), ((0, 1), (None, None, 0.470))])
def test_an_amplitude_of_cubespec_that_no_fit_saw(cubespec, seen, left_um):
    """Between the amplitudes of the records it is followed, beyond them it is not, and `trust` says so."""
    bench, groups = cubespec
    train = bench.all_but([groups[k] for k in seen], 5)
    fit = fit_hysteretic_stiffness(train, order=36, options=StiffnessOptions(springs=12))
    scores = benchmark("cubespec_one_model").scores(fit, groups, 5)
    for found, told in zip(scores, left_um, strict=True):
        assert told is None or found == pytest.approx(told, rel=0.1)
    if seen == (0, 1):
        said = trust(fit, groups[2][5].drive)
        assert (said.motion, 1e6 * said.error_rms) == pytest.approx((1.83, 0.111), rel=0.1)


@pytest.mark.promise("hysteretic-stiffness-24")
def test_what_the_page_says_of_a_blind_fit_goes_with_its_table():
    """Fold 5: 0.141 um at 200 mV is 43 % more than where it was seen, and 0.146 um at 300 mV is that of the table."""
    _, middle, large = rows_of(FOLDS)["fold 5"]
    page = " ".join(PAGE.split())
    assert "it leaves 0.141 µm at 200 mV, 43 % more than the fit that saw it" in page
    assert 0.141 / middle == pytest.approx(1.43, abs=0.01)
    assert "leaves 0.125 µm at 300 mV, less than the 0.146 µm of the fit to all three" in page
    assert large == pytest.approx(0.146, abs=5e-4)


ELSEWHERE = "| | 10 N | 25 N | 35 N, never seen | 50 N |\n"


@pytest.mark.promise("hysteretic-stiffness-27")
@pytest.mark.endurance
def test_springs_elsewhere_leave_what_the_page_says(capsys):
    """Linear models are the same anywhere. A search ends before its optimum, and rounding leads it to another place."""
    benchmark("springs_elsewhere").main()
    printed = [line.split()[2:] for line in capsys.readouterr().out.splitlines() if " N " in line]
    names, rows = zip(*lines_of(ELSEWHERE), strict=True)
    assert len(printed) == 8 and [names[k].split()[0].strip(",") for k in (0, 3)] == ["Bouc-Wen", "Duffing"]
    for place, (springs, linear, own) in enumerate((rows[:3], rows[3:])):
        for k, cells in enumerate(printed[4 * place : 4 * place + 4]):
            assert 0.5 * springs[k] < float(cells[0]) < min(1.5 * springs[k], 0.5 * linear[k])
            assert float(cells[1]) == pytest.approx(linear[k], rel=0.02)
            assert own[k] is None if len(cells) == 2 else float(cells[2]) == pytest.approx(own[k], rel=0.03)


@pytest.mark.promise("hysteretic-stiffness-17")
@pytest.mark.promise("hysteretic-stiffness-30")
def test_a_model_is_scored_as_the_page_says():
    """Rms by channel and period without the first samples of each, and their mean; by hand, of constants."""
    bench = benchmark("cubespec")
    drive, period = np.zeros((1000, 2)), 500
    output = np.repeat([[1.0, 2.0], [3.0, 4.0]], period, axis=0) * 1e-6
    output[: bench.DROP] = 7.0
    record = Recording("r", "", drive, output, 1.0, ("a", "b"), ("c", "d"), period)
    seen = []
    assert bench.score_um(lambda u: (seen.append(u), np.zeros((len(u), 2)))[1], record) == pytest.approx(2.5)
    assert seen[0].shape == (2000, 2)  # the end of the record ran before it


@pytest.mark.endurance
@needs_cubespec
def test_one_model_of_cubespec_beats_the_linear_compromise():
    def of(amplitude_mv):
        drive, output = (np.load(CUBESPEC / f"{name}_{amplitude_mv}mV_train.npy") for name in "uy")
        return multisine_recordings(drive, output, 6400.0, f"{amplitude_mv} mV")

    small, middle, large = (of(amplitude_mv) for amplitude_mv in (100, 200, 300))
    train = [small[0], *middle[:3], large[0]]
    held_out = [small[5], large[5]]
    fit = fit_hysteretic_stiffness(
        train,
        order=12,
        options=StiffnessOptions(3, (0.1, 0.5), delay_s=1 / 6400, exchanges=0, few_first=3),
        iterations=3,
    )
    linear = fit_linear(train, 12, exchanges=0)
    ratios = [rms(predicted_error(fit, r, drop=1000)) / rms(output_error(linear.modes, r, drop=1000)) for r in held_out]
    assert 0.1 < min(ratios) < max(ratios) < 0.95
    assert np.prod(ratios) < 0.65


# ------------------------------------------------------------------------------------------------------------- refusals
@pytest.mark.promise("hysteretic-stiffness-10")
def test_one_amplitude_is_refused(training):
    with pytest.raises(IdentificationError, match=r"all 3 records have one amplitude, 0\.3 rms .* another amplitude"):
        fit_hysteretic_stiffness(training[:3])
    close = [replace(r, drive=1.05 * r.drive) for r in training[:3]]
    with pytest.raises(IdentificationError, match="one amplitude"):
        fit_hysteretic_stiffness([*training[:3], *close])


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"rate_hz": 2000.0}, r"0\.6 V, 10: the sample rate is 2000 Hz and that of 0\.3 V, 0 1000 Hz"),
        ({"period_samples": None}, r"0\.6 V, 10: the record has 0 whole periods .*period_samples"),
        ({"output": np.zeros((1024, 1))}, r"0\.6 V, 10: 2 inputs and 1 output, where 0\.3 V, 0 has 2 and 2"),
        ({"drive": np.zeros((1024, 2))}, r"0\.6 V, 10: the drive does not change; excite"),
    ],
)
def test_a_record_that_does_not_fit_is_named(training, change, message):
    with pytest.raises(IdentificationError, match=message):
        fit_hysteretic_stiffness([training[0], replace(training[3], **change)])


def test_other_arguments_that_cannot_be(training, known):
    with pytest.raises(IdentificationError, match="no recording"):
        fit_hysteretic_stiffness([])
    with pytest.raises(IdentificationError, match=r"\[0\.3, 0\.1\] do not ascend from above 0"):
        fit_hysteretic_stiffness(training, options=StiffnessOptions(thresholds=(0.3, 0.1)))
    with pytest.raises(IdentificationError, match="0 springs were asked for; give at least 1"):
        fit_hysteretic_stiffness(training, options=StiffnessOptions(springs=0))
    with pytest.raises(IdentificationError, match="one amplitude"):
        fit_hysteretic_stiffness(training[:3], options=StiffnessOptions(springs=1))
    for thresholds in ((), (0.0, 0.1), (0.1, 0.1)):
        with pytest.raises(IdentificationError, match=re.escape(f"{list(thresholds)} do not ascend from above 0")):
            fit_hysteretic_stiffness(training, options=StiffnessOptions(thresholds=thresholds))
    with pytest.raises(IdentificationError, match="0 steps a sample"):
        fit_hysteretic_stiffness(training, options=StiffnessOptions(sub_steps=0))
    with pytest.raises(IdentificationError, match=r"at 2000 Hz, where the model has 2 and 2 at 1000 Hz"):
        predicted_error(known[0], replace(training[0], rate_hz=2000.0))
    with pytest.raises(IdentificationError, match=r"0: 2 inputs and 1 output at 1000 Hz, where the model has 2 and 2"):
        predicted_error(known[0], replace(training[0], output=training[0].output[:, :1]))


def small(size, inputs=1, periods=2, noise=0.0, name="r"):
    """A record of periods of 8 samples, with outputs of two sizes."""
    drive = size * np.tile(philox(2).standard_normal((8, inputs)), (periods, 1))
    output = drive[:, :1] * [1.0, 3.0]
    output[8:16] += noise
    return Recording(name, "", drive, output, 100.0, tuple(f"u{k}" for k in range(inputs)), ("y", "z"), 8)


@pytest.mark.parametrize(("inputs", "counts"), [(1, (1, 1)), (2, (2, 2)), (1, (1, 3)), (2, (4, 2))])
def test_an_amplitude_with_no_more_records_than_inputs_counts_by_its_outputs(inputs, counts):
    """The mean of the squares of its own class, for all classes."""
    records = [small(10.0**c * (1.0 + 0.01 * k), inputs) for c, count in enumerate(counts) for k in range(count)]
    classes = [c for c, count in enumerate(counts) for _ in range(count)]
    squares = np.array([np.mean(np.var(r.output, axis=0)) for r in records])
    of_class = [np.mean(squares[np.array(classes) == c]) for c in range(2)]
    np.testing.assert_allclose(_expected_squares(records, classes, 0), np.array(of_class)[classes], rtol=1e-12)


def test_the_noise_of_a_mean_of_periods_is_known_from_two_on():
    """Two periods that differ by 2 at each sample: a variance of 2 each, and half of that in their mean."""
    assert fit_of._noise_square(small(1.0, noise=2.0), 0) == pytest.approx(1.0)
    assert fit_of._noise_square(small(1.0, periods=3, noise=2.0), 1) == pytest.approx(1.0)
    assert fit_of._noise_square(small(1.0, noise=2.0), 1) == 0.0
    assert fit_of._noise_square(small(1.0, periods=1), 0) == 0.0


def test_records_need_a_period_behind_those_that_are_skipped_and_a_step_a_sample():
    alike = [small(1.0), small(2.0)]
    fit_of._check(alike, 1, StiffnessOptions(sub_steps=1, springs=1))
    for skip in (2, 3):
        with pytest.raises(
            IdentificationError, match=f"^r: the record has 2 whole periods and {skip} are to be skipped"
        ):
            fit_of._check(alike, skip, StiffnessOptions())


def test_amplitudes_are_of_one_class_as_long_as_each_is_near_the_next():
    records = [small(size, name=f"{size}") for size in (2.0, 1.05, 1.0, 1.12, 2.15, 1.22)]
    amplitudes, classes = amplitude_classes(records)
    assert classes == (1, 0, 0, 0, 1, 0)
    unit = np.std(records[2].drive)
    np.testing.assert_allclose(amplitudes, [unit * (1.05 + 1.0 + 1.12 + 1.22) / 4, unit * (2.0 + 2.15) / 2])
    assert amplitude_classes(records[2:3]) == ((pytest.approx(unit),), (0,))
    with pytest.raises(IdentificationError, match=r"^0: the drive does not change; excite the mirror"):
        amplitude_classes([records[0], small(0, name="0")])


def test_an_operator_that_goes_on_is_the_same_within_its_old_reach():
    play = PrandtlIshlinskii((0.0, 1.0), (2e-6, 1e-6), reach_v=3.0, polynomial_rad=(4e-6, 2e-6, 1e-6))
    further = _further(play, 7.5)
    assert further.reach_v == 7.5
    for freq_hz, amplitude_v in ((1.0, 2.9), (7.0, 1.3)):
        own, other = (model.loop(amplitude_v, freq_hz) for model in (play, further))
        np.testing.assert_allclose(other.output_rad, own.output_rad, rtol=0, atol=1e-12 * np.ptp(own.output_rad))
    assert _further(play, 2.0) is play


@pytest.mark.promise("hysteretic-stiffness-29")
def test_the_proof_stands_where_the_page_says():
    said = " ".join(springs_of.__doc__.split())
    for step in (
        "No drive makes such a mirror run away. Without drive",
        "never grows",
        "rises without bound with the states",
    ):
        assert step in said
    assert springs_of.MOST_SOFTENING == 0.9


@pytest.mark.promise("hysteretic-stiffness-11")
def test_a_search_goes_downhill_where_the_slope_falls_away_from_the_least_cost():
    """Of x^2 / (1 + x^2) from x = 3: the slope rises over the first steps, which tell no curvature; none is refused."""

    class Bell(Search):
        def slope(self, free):
            (x,) = free
            tried.append(x * x / (1.0 + x * x))
            return tried[-1], np.array([2.0 * x / (1.0 + x * x) ** 2])

        def cost(self, free):
            return self.slope(free)[0]

        def curvature(self, free):
            return np.array([[0.4]])

    one = springs_of.Springs(
        None, 0, np.eye(1), np.zeros(1), np.array(["phi"]), np.array([-np.inf]), np.array([np.inf])
    )
    tried, costs = [], []
    end = Bell(one, [], np.ones(0), [], None).minimise(
        np.array([3.0]), 5, 100, lambda done, free, cost: costs.append(cost)
    )
    assert tried == [0.9, *costs] and len(costs) == 5
    assert all(after < before for before, after in itertools.pairwise(tried))
    assert 0.0 < end[0] < 2.5


def test_numbers_that_records_do_not_tell_apart_leave_unseen_errors_alone(monkeypatch):
    """Two move the output alike but for a part in 1e5: what is unseen is that of their sum, not of their difference."""
    rng = np.random.default_rng(5)
    slopes, errors, apart = rng.standard_normal((3, 4, 12))
    parts = {}
    for k in range(4):
        jacobian = np.stack([slopes[k], slopes[k] + 1e-5 * apart[k]], axis=1)
        parts[k] = SimpleNamespace(
            cost=errors[k] @ errors[k], matrix=jacobian.T @ jacobian, gradient=jacobian.T @ errors[k]
        )
    monkeypatch.setattr(tangents, "play_plant", lambda *given: None)
    monkeypatch.setattr(tangents, "normal_equations", lambda plant, numbers, record, wanted: parts[record.number])
    records = [SimpleNamespace(number=k, step_s=1.0, output=np.zeros((12, 1))) for k in range(4)]
    springs = SimpleNamespace(numbers=lambda free: None, matrix=np.eye(2), inside=lambda free: slice(None))
    search = SimpleNamespace(
        records=records, springs=springs, weights=np.ones(4), wanted=slice(None), pool=SimpleNamespace(map=map)
    )
    unseen, moved = fit_of._other_records(search, np.zeros(2), [0, 0, 0, 0])
    matrices, pulls = np.sum(slopes**2, axis=1), np.sum(slopes * errors, axis=1)
    steps = pulls / (matrices.sum() - matrices)
    costs = np.sum(errors**2, axis=1) + 2.0 * pulls * steps + steps**2 * matrices
    np.testing.assert_allclose(unseen, np.sqrt(costs / 12), rtol=1e-3)
    alone = (pulls - pulls.mean()) / matrices.sum() * np.sqrt(4 / 3)
    np.testing.assert_allclose(moved.sum(axis=1), alone, rtol=1e-3, atol=1e-3 * np.abs(alone).max())
    np.testing.assert_allclose(moved[:, 0], moved[:, 1], rtol=1e-3, atol=1e-3 * np.abs(alone).max())


# ------------------------------------------------------------------------------------------ numbers unlike each other
@pytest.mark.parametrize(
    ("change", "options", "skip", "message"),
    [
        (
            {"samples": 23},
            {},
            2,
            "b: the record has 2 whole periods and 2 are to be skipped; this fit needs periodic excitation "
            "(multisines) in its steady state: give period_samples, or record more periods.",
        ),
        (
            {"rate_hz": 101.0},
            {},
            0,
            "b: the sample rate is 101 Hz and that of a 100 Hz; records that are fitted together must share one rate.",
        ),
        (
            {},
            {"thresholds": (0.1, 0.3, 0.2)},
            0,
            "the thresholds [0.1, 0.3, 0.2] do not ascend from above 0; sort them, each once, and leave out 0.",
        ),
        (
            {},
            {"thresholds": (-0.5, 0.3)},
            0,
            "the thresholds [-0.5, 0.3] do not ascend from above 0; sort them, each once, and leave out 0.",
        ),
        ({}, {"sub_steps": -2, "springs": 0}, 0, "-2 steps a sample were asked for; give at least 1."),
        ({}, {"springs": -3}, 0, "-3 springs were asked for; give at least 1."),
    ],
)
def test_what_cannot_be_fitted_is_told_in_full_for_the_second_record(change, options, skip, message):
    first, second = small(1.0, periods=3, name="a"), small(2.0, periods=3, name="b")
    other = second.first(change.pop("samples", 24))
    with pytest.raises(IdentificationError) as caught:
        fit_of._check([first, replace(other, **change)], skip, StiffnessOptions(**options))
    assert str(caught.value) == message


def test_a_record_is_the_mean_of_its_whole_periods_behind_those_skipped_in_units_of_the_search():
    drive, output = np.arange(70.0).reshape(35, 2), np.arange(105.0).reshape(35, 3) ** 2
    record = Recording("r", "", drive, output, 50.0, ("u", "v"), ("x", "y", "z"), 8)
    steady = fit_of._steady(record, (2.0, 5.0), 3, 1)
    np.testing.assert_allclose(steady.drive, (drive[8:16] + drive[16:24] + drive[24:32]) / 6)
    mean = (output[8:16] + output[16:24] + output[24:32]) / 3
    np.testing.assert_allclose(steady.output, (mean - mean.mean(axis=0)) / 5)
    assert (steady.name, steady.rate_hz, steady.sub_steps, steady.step_s) == ("r", 50.0, 3, pytest.approx(1 / 150))
    whole = fit_of._periods(replace(record, period_samples=None), output, 0)
    np.testing.assert_array_equal(whole, output[None])
    both = [record, replace(record, drive=3 * drive, output=output / 7)]
    assert fit_of._unit(both, "drive") == pytest.approx(np.sqrt(np.mean(drive.var(axis=0)) * 5))
    assert fit_of._unit(both, "output") == pytest.approx(np.sqrt(np.mean(output.var(axis=0)) * 25 / 49))


def test_a_search_may_end_where_eight_steps_gained_next_to_nothing():
    told = []
    one = fit_of._Told(lambda *args: told.append(args), 40, 0.01)
    one.begin(15, 4.0)
    ends = [one(k, None, cost) for k, cost in enumerate([3.9] * 6 + [3.0, 3.922, 3.9], 1)]
    assert ends == [False] * 7 + [True, True]
    assert told[0] == (16, 40, "error 1.9748") and told[6] == (22, 40, "error 1.7321") and told[-1][:2] == (24, 40)
    assert one.costs[:2] == [2.0, np.sqrt(3.9)]
    one.begin(20, 4.0)
    assert [one(k, None, 4.0 * 0.98**k) for k in range(1, 10)] == [False] * 9


def test_a_start_in_units_of_the_search_is_the_same_model_with_even_vectors():
    draw = philox(7).standard_normal((4, 3, 2))
    poles, c = np.array([-9.0 + 0j, -2 + 30j, -3 + 70j]), 1e3 * (draw[2] + 1j * draw[3]).T
    b = draw[0] + 1j * draw[1]
    b[0], c[:, 0] = b[0].real, c[:, 0].real
    start = LinearStart(ModalModel(poles, b, c, draw[0, :2]), 3e-4)
    found = fit_of._in_units(start, (0.25, 1e-3))
    freq = np.array([0.5, 4.0, 11.0])
    np.testing.assert_allclose(found.model.response(freq), 250.0 * start.model.response(freq), rtol=1e-12)
    sizes = np.linalg.norm(found.model.input_vectors, axis=1), np.linalg.norm(found.model.output_vectors, axis=0)
    np.testing.assert_allclose(*sizes)
    assert found.delay_s == 3e-4


def test_a_linear_start_lies_behind_the_delay_that_is_given_or_the_best_on_the_grid(monkeypatch):
    """Costs of nine delays, the fourth one least; no more than twenty states look for it."""
    asked = []

    def fitted(response, order, **words):
        asked.append((float(response.response[0, 0, 0].imag), order, words))
        return SimpleNamespace(cost=abs(len(asked) - 4), model="model")

    monkeypatch.setattr(model_of, "fit_order", fitted)
    monkeypatch.setattr(model_of, "without_delay", lambda response, delay_s, steps: replaced(delay_s, steps))

    def replaced(delay_s, steps):
        return SimpleNamespace(response=np.full((1, 1, 1), 1j * delay_s * steps))

    response = SimpleNamespace(rate_hz=50.0)
    assert model_of.linear_start(response, 28, 3, None, 5) == ("model", pytest.approx(0.015))
    assert [(order, words) for _, order, words in asked] == [(20, {"exchanges": 0, "fine": False})] * 9 + [
        (28, {"exchanges": 5})
    ]
    assert [at for at, *_ in asked] == pytest.approx([*(3 * 0.005 * k for k in range(9)), 0.045])
    asked.clear()
    assert model_of.linear_start(response, 6, 2, 0.0, 1) == ("model", 0.0)
    assert asked == [(0.0, 6, {"exchanges": 1})]


def test_the_mirror_of_numbers_has_pairs_before_real_poles_and_each_operator_its_own(numbers):
    two = replace(
        numbers,
        decay=np.array([-30.0, -50.0, -100.0]),
        frequency=np.array([600.0, 200.0]),
        B=np.arange(10.0).reshape(5, 2),
        E=np.zeros((5, 4)),
        F=np.zeros((4, 5)),
        C=np.zeros((2, 5)),
    )
    plant = two.mirror("named")
    expected = np.diag([-30.0, -30.0, -50.0, -50.0, -100.0])
    expected[0, 1], expected[1, 0], expected[2, 3], expected[3, 2] = -600.0, 600.0, -200.0, 200.0
    np.testing.assert_array_equal(plant.A, expected)
    assert (plant.name, plant.bouc_wen, plant.inverse) == ("named", (), ())
    assert [play.reach_v for play in plant.plays] == [1.0, 2.0, 3.0, 1.5]
    for e, play in enumerate(plant.plays):
        assert play.thresholds_v == tuple(numbers.thresholds[e]) and play.weights_rad_v == tuple(numbers.weights[e])
        assert play.polynomial_rad == tuple(numbers.polynomial[e])
    assert two.rows == [0, 2, 4]
    assert two.poles.tolist() == [-30 + 600j, -50 + 200j, -100]
    assert two.poles_at_rest == pytest.approx([-50 + 200j, -30 + 600j, -100])
    assert two.names[:3] == tuple(f"modes.decay.{k}" for k in (1, 2, 3))
    assert two.names[3:7] == ("modes.frequency.1", "modes.frequency.2", "matrices.B.1.1", "matrices.B.1.2")
    assert "hysteresis.4.polynomial.3" in two.names and "hysteresis.3.weights.2" in two.names
    assert len(two.names) == len(set(two.names)) == two.vector().size
    again = two.at(2.0 * two.vector())
    assert again.delay_s == 2 * numbers.delay_s and again.weights.tolist() == (2 * numbers.weights).tolist()
    assert again.thresholds is numbers.thresholds


def test_numbers_in_other_units_have_each_its_own_factor(numbers):
    found = scaled(numbers, 4.0, 10.0)
    factors = {"B": 0.25, "E": 0.25, "F": 4.0, "G": 1.0, "polynomial": 4.0, "thresholds": 4.0, "reach": 4.0}
    factors |= {"C": 10.0, "D": 2.5, "K": 2.5, "weights": 1.0, "decay": 1.0, "frequency": 1.0}
    for name, factor in factors.items():
        np.testing.assert_allclose(getattr(found, name), factor * getattr(numbers, name), err_msg=name)
    assert found.delay_s == numbers.delay_s


def test_the_slope_of_a_polynomial_is_that_of_its_powers_within_its_reach():
    q = np.array([[0.5, -1.5, 2.0], [1.2, -5.0, -2.5]])
    reach, c = np.array([1.0, 4.0, np.inf]), np.array([[0.1, 0.2, 0.3], [-0.4, 0.5, 0.6], [7.0, 8.0, 9.0]])
    found = tangents.powers(q, reach)
    np.testing.assert_allclose(found[0], [[0.25, 0.25, 0.125], [0.140625, -0.140625, -0.052734375], [0.0] * 3])
    np.testing.assert_allclose(found[1], [[1.0, 1.0, 1.0], [1.0, -1.0, -1.0], [0.0] * 3])
    plant = SimpleNamespace(operator=np.column_stack([np.full((3, 2), 99.0), c, reach]))
    slope = tangents.bend(plant, SimpleNamespace(q=q))
    step = 1e-6
    expected = np.einsum("kei,ei->ke", tangents.powers(q + step, reach) - tangents.powers(q - step, reach), c) / (
        2 * step
    )
    np.testing.assert_allclose(slope, expected, atol=1e-9)


def test_the_shapes_of_springs_are_forces_then_outputs_then_those_with_pairs_the_other_way():
    forces, seen = np.array([[1.0], [2.0], [3.0], [4.0]]), np.array([[5.0, 9.0], [6.0, 10.0], [7.0, 11.0], [8.0, 12.0]])
    found = springs_of._shapes(forces, seen, 8)
    signs = np.array([[1, 1, 1, 1], [1, -1, 1, -1], [1, 1, -1, -1]]).T
    both = np.hstack([forces, seen])
    np.testing.assert_array_equal(found, np.hstack([both, both * signs[:, [1]], both[:, :2] * signs[:, [2]]]))
    alike = np.array([[1.0, -2.0, 0.0, 3.0, 0.0], [1.0, -2.0, 1.0, 3.0, 0.0]])
    np.testing.assert_array_equal(springs_of._alike(alike, 2), [0, 1, 0, 2, 0, 0, 0])


def limited(least, most, kinds=("phi",)):
    """Free numbers between their limits."""
    least, most = np.array(least), np.array(most)
    kinds = np.array((*kinds, *kinds[-1:] * (least.size - len(kinds))))
    return springs_of.Springs(None, 0, np.eye(least.size), np.zeros(least.size), kinds, least, most)


def test_a_number_at_a_limit_may_move_back_and_not_beyond():
    one = limited([0.0, 0.0, -np.inf, -np.inf, 1.0], [np.inf, np.inf, 5.0, 5.0, 3.0])
    free = np.array([0.0, 0.0, 5.0, 5.0, 2.0])
    assert one.loose(free, np.array([1.0, -1.0, 1.0, -1.0, 9.0])).tolist() == [False, True, True, False, True]
    assert one.inside(free).tolist() == [False, False, False, False, True]
    assert one.within(np.array([-1.0, 7.0, 6.0, -9.0, 0.5])).tolist() == [0.0, 7.0, 5.0, -9.0, 1.0]


def test_softening_is_the_largest_share_of_stiffness_by_hand(numbers):
    """One spring on two pairs of the stiffnesses (s^2 + w^2) / w: 10.4 and 5.2; it counts the sum of its plays."""
    two = replace(
        numbers, decay=np.array([-2.0, -1.0]), frequency=np.array([10.0, 5.0]), weights=np.array([[0.1, 0.2, 0.3]])
    )
    two = replace(two, F=np.array([[9.0, 2.0, 9.0, -3.0]]), polynomial=np.zeros((1, 3)))
    springs = springs_of.Springs(two, 1, None, None, None, None, None)
    assert springs.softening(two) == pytest.approx(0.6 * (4 / 10.4 + 9 / 5.2))
    assert springs.redundant == 0
    none = replace(
        two, F=np.array([[9.0, 2.0, 9.0, 0.0]]), decay=np.array([-2.0, -1.0, -7.0]), weights=np.zeros((3, 3))
    )
    assert springs_of.Springs(none, 1, None, None, None, None, None).redundant == 2 + 1 + 2


def test_the_last_steps_correct_the_inverse_curvature_over_the_loose_numbers():
    """By the formula of Broyden, Fletcher, Goldfarb and Shanno, step after step; one that curves down counts not."""
    draw = philox(2).standard_normal
    size, loose = np.array([2.0, 0.5, 1.0, 4.0]), np.array([True, False, True, True])
    root = draw((3, 3))
    matrix, slope = root @ root.T + np.eye(3), draw(4)
    pairs = []
    for _ in range(3):
        s = draw(4)
        pairs.append((s, s * np.array([3.0, 1.0, 2.0, 5.0]) + 0.1 * draw(4)))
    pairs.insert(1, (np.array([1.0, 0.0, 1.0, 1.0]), np.array([-1.0, 5.0, -2.0, -1.0])))
    inverse = np.linalg.inv(matrix)
    for s, y in pairs:
        way, bent = (s * size)[loose], (y / size)[loose]
        if way @ bent > 0:
            left = np.eye(3) - np.outer(way, bent) / (way @ bent)
            inverse = left @ inverse @ left.T + np.outer(way, way) / (way @ bent)
    factor, damping = search_of._factor(matrix - 0.25 * np.eye(3), 0.25)
    assert damping == 0.25
    found = search_of._newton(factor, pairs, slope, size, loose)
    np.testing.assert_allclose(found, inverse @ (slope / size)[loose] / size[loose], rtol=1e-9)


def test_damping_rises_eightfold_until_there_is_a_factor():
    matrix = np.array([[1.0, 0.0], [0.0, -3.0]])
    factor, damping = search_of._factor(matrix, 0.01)
    assert damping == pytest.approx(5.12)
    np.testing.assert_allclose(np.triu(factor[0]) ** 2, np.diag([6.12, 2.12]), atol=1e-12)


def test_the_size_of_a_number_that_hardly_acts_is_that_of_its_kind():
    one = Search(limited([0.0] * 4, [1.0] * 4, ("phi", "phi", "weights")), [], np.ones(0), [], None)
    found = one.size(np.diag([4.0, 0.0, 9.0, 1.0]))
    np.testing.assert_allclose(found**2, [4.06, 0.06, 9.15, 1.15])
    np.testing.assert_allclose(one.size(np.diag([4.0, 4.0, 0.0, 0.0])) ** 2, [4.12, 4.12, 4.12e-12, 4.12e-12])


def test_the_curvature_of_few_records_stands_for_all_by_their_weights(monkeypatch):
    """Of three records two, each by two ends; as many samples as 40 numbers for each count, no more than all."""
    asked = []

    def curved(plant, numbers, record, end, part, wanted):
        asked.append((plant, numbers, record.name, end, part, wanted.tolist()))
        return record.name * np.array([[2.0, 1.0], [1.0, 3.0]])

    monkeypatch.setattr(tangents, "curvature", curved)
    monkeypatch.setattr(tangents, "play_plant", lambda numbers, step_s: ("plant", step_s))
    springs = SimpleNamespace(matrix=np.array([[1.0, 0.0], [0.0, 0.0], [2.0, 5.0]]), numbers=lambda free: "numbers")
    records = [
        SimpleNamespace(name=k, step_s=0.5, output=np.zeros((samples, 2)))
        for k, samples in ((1, 10), (10, 60), (100, 90))
    ]
    one = Search(springs, records, np.array([0.25, 0.5, 0.125]), [0, 2], SimpleNamespace(map=map))
    found = one.curvature(np.zeros(2))
    whole = np.array([[2.0, 1.0], [1.0, 3.0]]) * (0.25 * 1 + 0.125 * 100)
    T = np.array([[1.0, 0.0], [2.0, 5.0]])
    np.testing.assert_allclose(found, 2 * (0.875 / 0.375) * (T.T @ whole @ T))
    part = 40 * 2 / 200 / 2
    assert asked == [
        (("plant", 0.5), "numbers", k, end, pytest.approx(part), [True, False, True])
        for k in (1, 100)
        for end in (0.5, 1.0)
    ]


def test_the_power_that_no_linear_model_follows_is_that_of_each_class_and_the_noise_of_each_record():
    """Three records of one drive in each of two classes, three periods each: what is left of a class is one part."""
    records = []
    for k in range(6):
        draw = philox(20 + k)
        drive = np.tile(draw.standard_normal((16, 1)), (3, 1)) * (1.0 if k < 3 else 5.0)
        output = np.column_stack([2.0 * drive, drive**2]) + (0.1 + 0.2 * k) * draw.standard_normal((48, 2))
        records.append(Recording(f"r{k}", "", drive, output, 100.0, ("u",), ("y", "z"), 16))
    classes = [0, 0, 0, 1, 1, 1]
    noise = np.array([np.mean(np.var(r.output.reshape(3, 16, 2), axis=0, ddof=1)) / 3 for r in records])
    left = [response_from_periods(records[k : k + 3]).residual_power.sum(axis=0).mean() for k in (0, 3)]
    distortion = [max(left[c] - noise[3 * c : 3 * c + 3].mean(), 0.0) for c in (0, 1)]
    expected = np.repeat(distortion, 3) + noise
    np.testing.assert_allclose(_expected_squares(records, classes, 0), expected, rtol=1e-9)
    assert distortion[1] > distortion[0] >= 0.0


@pytest.mark.parametrize(
    ("reach", "largest", "times"), [(2.0, 5.0, 2.5), (2.0, 2.0, None), (2.0, 1.5, None), (np.inf, 9.0, None)]
)
def test_an_operator_goes_on_beyond_its_reach_alone(reach, largest, times):
    play = PrandtlIshlinskii((0.0, 0.5), (1.0, -0.25), polynomial_rad=(1.0, -2.0, 3.0), reach_v=reach)
    found = fit_of._further(play, largest)
    if times is None:
        assert found is play
    else:
        bent = (times**2, -2 * times**2, 3 * times**3)
        assert found == replace(play, reach_v=largest, polynomial_rad=pytest.approx(bent))


@pytest.mark.parametrize(
    ("sizes", "amplitudes", "classes"),
    [
        ([2.0, 1.0, 2.1, 1.2, 5.0], [0.5, 0.6, 1.025, 2.5], [2, 0, 2, 1, 3]),
        ([1.0, 1.09, 1.18, 1.29], [0.57], [0, 0, 0, 0]),
        ([3.0, 1.0], [0.5, 1.5], [1, 0]),
        ([4.0], [2.0], [0]),
        ([1.0, 1.11, 1.0], [0.5, 0.555], [0, 1, 0]),
    ],
)
def test_amplitudes_that_are_within_a_tenth_of_the_next_are_one_class(sizes, amplitudes, classes):
    """A drive of 0 and of its size has half of it as its rms about the mean."""
    records = [SimpleNamespace(path=str(s), drive=np.array([[0.0], [s]])) for s in sizes]
    found, own = amplitude_classes(records)
    assert found == pytest.approx(amplitudes) and own == tuple(classes)
    still = SimpleNamespace(path="still", drive=np.full((2, 1), 7.0))
    with pytest.raises(IdentificationError) as refused:
        amplitude_classes([*records, still])
    assert str(refused.value) == "still: the drive does not change; excite the mirror."


@pytest.mark.parametrize(
    ("amplitudes", "classes", "middle"),
    [
        ((1.0, 3.0, 10.0), (0, 0, 1, 2, 2, 2), 1),
        ((1.0, 3.0, 10.0), (0, 1, 2), 1),
        ((1.0, 3.0, 10.0), (0, 1, 2, 2, 2, 2), 2),
        ((1.0, 3.0, 10.0), (0, 0, 0, 0, 2), 0),
        ((1.0, 4.0), (0, 1), 0),
        ((1.0, 4.0), (0, 1, 1), 1),
    ],
)
def test_the_middle_amplitude_is_next_to_the_geometric_mean_of_all_records(amplitudes, classes, middle):
    assert fit_of._middle(amplitudes, classes) == middle


@pytest.mark.parametrize(
    ("drives", "classes", "few"),
    [
        ([(1, 0), (0, 1), (1, 1), (2, 0), (1, 0), (0, 0)], (0, 0, 0, 1, 0, 1), [0, 1, 2, 3, 5]),
        ([(1, 1), (2, 3), (1, 1)], (0, 0, 1), [0, 2]),
        ([(0, 2), (2, 0), (0, 3)], (1, 1, 1), [0, 1]),
    ],
)
def test_one_record_of_each_amplitude_and_set_of_actuators_comes_first(drives, classes, few):
    records = [SimpleNamespace(drive=np.array([[0.0, 0.0], each])) for each in drives]
    assert fit_of._few(records, classes) == few


@pytest.mark.parametrize(
    ("costs", "ends"),
    [
        ([3.9] * 7 + [3.895], []),
        ([3.9] * 8 + [3.895, 3.0], [9]),
        ([4.0 * 0.9**k for k in range(1, 12)], []),
        ([4.0 * 0.999**k for k in range(1, 12)], [8, 9, 10, 11]),
        ([3.95] + [3.92] * 8, [9]),
    ],
)
def test_a_search_is_told_by_its_error_and_ends_where_eight_steps_gain_less_than_a_hundredth(costs, ends):
    told = []
    own = fit_of._Told(lambda *args: told.append(args), 20, 0.01)
    own.begin(3, 4.0)
    ended = [k for k, cost in enumerate(costs, 1) if own(k, np.zeros(1), cost)]
    assert ended == ends
    assert told == [(3 + k, 20, f"error {cost**0.5:.4f}") for k, cost in enumerate(costs, 1)]
    assert own.costs == [2.0, *(pytest.approx(cost**0.5) for cost in costs)]
    own.begin(11, 2.25)
    assert (own.before, own.costs) == (11, [1.5])


def test_numbers_are_named_in_the_order_of_their_vector(numbers):
    """A pair and two real poles of four states, two drives, two outputs, four operators of three plays."""
    names = dict(zip(numbers.names, numbers.vector(), strict=True))
    assert list(names)[:4] == [*(f"modes.decay.{k}" for k in (1, 2, 3)), "modes.frequency.1"]
    assert list(names)[-1] == "recording.delay"
    for name in ("B", "E", "F", "G", "C", "D", "K"):
        for (i, j), value in np.ndenumerate(getattr(numbers, name)):
            assert names.pop(f"matrices.{name}.{i + 1}.{j + 1}") == value
    for name in ("weights", "polynomial"):
        for (i, j), value in np.ndenumerate(getattr(numbers, name)):
            assert names.pop(f"hysteresis.{i + 1}.{name}.{j + 1}") == value
    assert list(names.values()) == [-30.0, -50.0, -100.0, 600.0, 3e-4]
    assert numbers.rows == [0, 2, 3] and numbers.poles.tolist() == [-30 + 600j, -50.0, -100.0]
    again = numbers.at(2.0 * numbers.vector())
    np.testing.assert_array_equal(again.vector(), 2.0 * numbers.vector())
    assert again.thresholds is numbers.thresholds and again.delay_s == 6e-4


@pytest.mark.parametrize(
    ("inputs", "outputs", "rate_hz", "told"),
    [
        (2, 3, 400.0, "2 inputs and 3 outputs at 400 Hz"),
        (3, 2, 400.0, "3 inputs and 2 outputs at 400 Hz"),
        (2, 1, 400.5, "2 inputs and 1 output at 400.5 Hz"),
        (1, 1, 400.0, "1 input and 1 output at 400 Hz"),
    ],
)
def test_a_record_of_other_channels_or_rate_is_not_predicted(inputs, outputs, rate_hz, told):
    """The model has two actuators and one output."""
    fit = SimpleNamespace(rate_hz=400.0, mirror=SimpleNamespace(actuators=2, axes=1))
    names = tuple("abc")
    record = Recording("r", "", np.ones((4, inputs)), np.ones((4, outputs)), rate_hz, names[:inputs], names[:outputs])
    with pytest.raises(IdentificationError) as refused:
        predicted_error(fit, record)
    assert str(refused.value) == (f"r: {told}, where the model has 2 and 1 at 400 Hz; give a record like those fitted.")


def test_a_drive_at_rest_leaves_nothing_where_errors_rise_with_it(known):
    fit = replace(known[0], error_rms=np.asarray(np.take(known[0].amplitudes, known[0].classes)))
    assert trust(fit, np.zeros((64, known[0].mirror.B.shape[1]))).error_rms == 0.0


def test_periods_to_be_skipped_are_none_or_more(known):
    record = record_of(hysteretic_truth(), 0.9, 78)
    with pytest.raises(IdentificationError, match=r"^-1 periods are to be skipped; skip none or more\.$"):
        fit_of._check([record], -1, StiffnessOptions())


def test_a_fit_is_trusted_by_the_operator_that_goes_farthest_beyond_its_own_motion_and_by_both_amplitudes():
    """Two operators on two drives, and errors that rise as the square of the amplitude: 2 and 8 um at 0.5 and 1 V."""
    plays = tuple(PrandtlIshlinskii((0.0, 0.5), (w, w / 2)) for w in (1.0, 3.0))
    none = np.zeros((0, 0))
    own = Mirror(
        *("two", none, np.zeros((0, 2)), np.zeros((0, 2)), np.zeros((2, 0)), np.eye(2)),
        *(np.zeros((1, 0)), np.zeros((1, 2)), np.ones((1, 2)), (), plays, ()),
    )
    fit = SimpleNamespace(
        mirror=own,
        classes=(1, 0, 1, 0, 0),
        amplitudes=(0.5, 1.0),
        error_rms=1e-6 * np.array([4.0, 2.0, np.sqrt(112.0), 1.0, np.sqrt(7.0)]),
        rate_hz=100.0,
        sub_steps=2,
        delay_s=0.0,
        motion=np.array([4.0, 0.5]),
    )
    turn = 2 * np.pi * np.arange(64) / 64
    drive = np.column_stack([3.0 * np.sin(turn), 0.75 * np.sin(2 * turn)])
    found = trust(fit, drive)
    assert found.motion == pytest.approx(1.5, rel=1e-6)  # of the second: 0.75 V, where 0.5 V were recorded
    mean_square = (3.0**2 + 0.75**2) / 4
    assert found.left == found.error_rms == pytest.approx(8e-6 * mean_square, rel=1e-9) and found.open == 0.0


@pytest.mark.parametrize("given", [True, False])
@pytest.mark.parametrize("delay_s", [None, 2e-4])
def test_springs_begin_with_the_records_of_the_largest_and_of_the_middle_amplitude_in_any_order(
    monkeypatch, given, delay_s
):
    """Seven records of three amplitudes; the first period of each output is none of its steady state."""
    sizes = {"a": 3.0, "b": 1.0, "c": 9.0, "d": 3.0, "e": 1.0, "f": 9.0, "g": 3.0}
    records = []
    for k, (name, size) in enumerate(sizes.items()):
        one = np.random.Generator(np.random.Philox(k)).standard_normal((32, 1))
        drive = size * np.tile(one / one.std(), (3, 1))
        output = 1e-6 * np.roll(drive, k, axis=0) + np.where(np.arange(96) < 32, 1e-4, 0.0)[:, None]
        records.append(Recording(name, "", drive, output, 400.0, ("u",), ("y",), 32))
    model = ModalModel(np.array([-9.0 + 40j]), np.ones((1, 1)) + 0j, np.ones((1, 1)) + 0j, np.ones((1, 1)))
    asked = []

    class BegunError(Exception):
        pass

    def begin(*args, **words):
        raise BegunError(*args, words)

    monkeypatch.setattr(fit_of, "linear_start", lambda *args: asked.append(args) or LinearStart(model, 1e-4))
    monkeypatch.setattr(springs_of, "begin", begin)
    options = StiffnessOptions(springs=3, thresholds=(0.1, 0.3), sub_steps=4, delay_s=delay_s, exchanges=5)
    words = {"start": LinearStart(model, 3e-4)} if given else {}
    with pytest.raises(BegunError) as caught:
        fit_hysteretic_stiffness(records, order=6, options=options, skip_periods=1, **words)
    linear, largest, middle, *rest = caught.value.args
    assert rest == [3, (0.1, 0.3), {"fixed_delay": delay_s is not None}]
    assert [r.name for r in largest] == ["c", "f"] and [r.name for r in middle] == ["a", "d", "g"]
    drive, output = (np.sqrt(np.mean([np.var(getattr(r, of)) for r in records])) for of in ("drive", "output"))
    for steady, record in zip(largest, (records[2], records[5]), strict=True):
        np.testing.assert_allclose(steady.drive, record.drive[32:64] / drive)
        np.testing.assert_allclose(steady.output, (record.output[32:64] - record.output[32:64].mean()) / output)
        assert (steady.rate_hz, steady.sub_steps) == (400.0, 4)
    np.testing.assert_allclose(linear.model.direct, [[drive / output]])
    assert linear.delay_s == (3e-4 if given else 1e-4) and len(asked) == (not given)
    if not given:
        response, *others = asked[0]
        assert others == [6, 4, delay_s, 5]
        expected = response_from_periods([records[k] for k in (0, 3, 6)], skip_periods=1)
        np.testing.assert_allclose(response.response, expected.response)
        np.testing.assert_allclose(response.standard_error, expected.standard_error)


@pytest.mark.parametrize("unit", [1.0, 1e4])
def test_where_the_error_falls_with_the_amplitude_as_much_is_left_as_the_fit_leaves_whatever_the_unit(unit):
    """4, 2 and 0.5 um at amplitudes of 1, 2 and 4: their geometric mean."""
    none = np.zeros((0, 0))
    own = Mirror(
        *("one", none, np.zeros((0, 1)), np.zeros((0, 1)), np.zeros((1, 0)), np.eye(1)),
        *(np.zeros((1, 0)), np.zeros((1, 1)), np.ones((1, 1)), (), (PrandtlIshlinskii((0.0,), (1.0,)),), ()),
    )
    fit = SimpleNamespace(mirror=own, classes=(0, 1, 2), amplitudes=(unit, 2 * unit, 4 * unit), motion=np.array([unit]))
    fit.error_rms, fit.rate_hz, fit.sub_steps, fit.delay_s = 1e-6 * np.array([4.0, 2.0, 0.5]), 100.0, 1, 0.0
    drive = 9.0 * unit * np.sin(2 * np.pi * np.arange(32) / 32)[:, None]
    assert trust(fit, drive).left == pytest.approx(1e-6 * 4.0 ** (1 / 3), rel=1e-9)


@pytest.mark.parametrize(("lowest", "taken"), [(-0.1, 0.64), (-0.005, 0.01), (-0.7, 5.12)])
def test_a_damping_that_is_too_small_becomes_eight_times_as_large_and_no_less(lowest, taken):
    (factor, _), damping = search_of._factor(np.diag([1.0, lowest]), 0.01)
    assert damping == pytest.approx(taken)
    np.testing.assert_allclose(np.diag(factor), np.sqrt([1.0 + taken, lowest + taken]))


def line(least=-np.inf, most=np.inf):
    """One free number, which stands for itself."""
    return springs_of.Springs(None, 0, np.eye(1), np.zeros(1), np.array(["phi"]), np.array([least]), np.array([most]))


@pytest.mark.parametrize(
    ("costs", "tried", "refusals"),
    [
        ([9.0], [1.0], 0),
        ([np.inf, 9.0], [1.0, 0.5], 0),
        ([11.0, 9.0], [1.0, 0.3], 1),
        ([np.inf, 11.0, 9.0], [1.0, 0.5, 0.15], 1),
        ([11.0, np.inf, 9.0], [1.0, 0.3, 0.15], 1),
        ([11.0, 10.0], [1.0, 0.3], None),
        ([np.inf] * 12, [0.5**k for k in range(12)], None),
        ([10.0 - 1.9e-4, 9.0], [1.0, 0.3], 1),
        ([10.0 - 2.1e-4], [1.0], 0),
    ],
)
def test_a_step_that_costs_more_is_tried_once_more_at_three_tenths_and_one_that_runs_away_at_half(
    monkeypatch, costs, tried, refusals
):
    """From 5 by -4, at a slope of 0.5: a whole step is to gain more than a ten-thousandth of the 2 that it promises."""
    left, asked = list(costs), []

    def slope(free):
        asked.append(("slope", float(free[0])))
        return (left.pop(0) if left and len(asked) == 1 else 77.0), np.array([3.0])

    one = Search(line(), [], np.ones(0), [], None)
    monkeypatch.setattr(one, "slope", slope)
    monkeypatch.setattr(one, "cost", lambda free: asked.append(("cost", float(free[0]))) or left.pop(0))
    step = one._along(np.array([5.0]), np.array([-4.0]), 10.0, np.array([0.5]))
    again = [("slope", 5.0 - 4.0 * tried[-1])] if step and len(tried) > 1 else []
    assert [what for what, _ in asked] == ["slope", *["cost"] * (len(tried) - 1), *["slope"] * len(again)]
    assert [at for _, at in asked] == pytest.approx([5.0 - 4.0 * part for part in tried] + [at for _, at in again])
    if refusals is None:
        assert step is None
    else:
        assert (step.cost, step.refusals, step.slope.tolist()) == (costs[-1], refusals, [3.0])
        assert step.free == pytest.approx([5.0 - 4.0 * tried[-1]])


def test_a_step_ends_at_a_limit_and_is_judged_by_what_it_promises_that_far(monkeypatch):
    one = Search(line(least=4.0), [], np.ones(0), [], None)
    monkeypatch.setattr(one, "slope", lambda free: (10.0 - 1e-4, np.array([3.0])))
    step = one._along(np.array([5.0]), np.array([-40.0]), 10.0, np.array([0.5]))
    assert step.free.tolist() == [4.0]


def scripted(monkeypatch, steps, iterations=99, refresh=2, ends=lambda done: False):
    """A search whose steps come out as told: None, or how many were tried in vain; what it asks for, and its end."""
    left, asked = list(steps), []
    one = Search(line(), [], np.ones(0), [], None)
    monkeypatch.setattr(one, "slope", lambda free: (100.0, np.array([1.0])))
    monkeypatch.setattr(one, "curvature", lambda free: asked.append(f"curvature at {free[0]:g}") or np.array([[4.0]]))
    monkeypatch.setattr(one, "size", lambda matrix: np.sqrt(np.diag(matrix)))

    def bounded(free, slope, curvature, damping):
        matrix, size, pairs = curvature
        assert (matrix.tolist(), size.tolist()) == ([[1.0]], [2.0])
        asked.append((damping, len(pairs)))
        return np.array([-1.0]), damping

    def along(free, move, cost, slope):
        refusals = left.pop(0)
        if refusals is None:
            return None
        return search_of._Step(free + move, cost - 1.0, slope + 2.0, refusals)

    monkeypatch.setattr(one, "_bounded_step", bounded)
    monkeypatch.setattr(one, "_along", along)
    told = []
    end = one.minimise(
        np.array([50.0]), iterations, refresh, lambda done, free, cost: told.append((done, free[0], cost)) or ends(done)
    )
    assert left == [] and told == [(k, 50.0 - k, 100.0 - k) for k in range(1, len(told) + 1)]
    assert end == 50.0 - len(told)
    return asked


def test_damping_falls_with_each_whole_step_and_rises_with_others_and_the_curvature_is_taken_anew(monkeypatch):
    """Every second step; before that where a step leads nowhere, unless it was just taken."""
    asked = scripted(monkeypatch, [0, 1, None, None, 0, None, 0], ends=lambda done: done == 4)
    dampings = [each[0] for each in asked if isinstance(each, tuple)]
    assert dampings == pytest.approx([1e-2, 5e-3, 1e-2, 3e-2, 9e-2, 4.5e-2, 0.135])
    assert [each if isinstance(each, str) else each[1] for each in asked] == [
        *("curvature at 50", 0, 1),
        *("curvature at 48", 0, 0, 0, 1),
        *("curvature at 47", 0),
    ]


def test_a_search_ends_with_the_ninth_step_in_a_row_that_leads_nowhere(monkeypatch):
    asked = scripted(monkeypatch, [0, *[None] * 8, 0, *[None] * 9])
    assert len([each for each in asked if isinstance(each, tuple)]) == 19
    assert asked[-1][0] == pytest.approx(1e-2 / 4 * 3.0**16)


def test_a_search_keeps_thirty_steps_and_a_least_damping_and_ends_after_its_largest_number(monkeypatch):
    asked = scripted(monkeypatch, [0] * 40, iterations=40, refresh=100)
    assert asked[0] == "curvature at 50"
    assert [pairs for _, pairs in asked[1:]] == [min(k, 30) for k in range(40)]
    assert [damping for damping, _ in asked[1:]] == pytest.approx([max(1e-2 / 2**k, 1e-5) for k in range(40)])


def test_a_fit_is_trusted_by_steps_so_fine_that_its_polynomial_goes_on_as_far_as_the_drive(monkeypatch):
    """At 100 Hz and two steps a sample the loop through what goes on is no contraction above 2 ms: eight are taken."""
    plays = (PrandtlIshlinskii((0.0,), (1.0,), 0.0, np.inf, (0.0, 0.0, 0.1), 2.0),)
    none = np.zeros((0, 0))
    own = Mirror(
        *("one", none, np.zeros((0, 1)), np.zeros((0, 1)), np.zeros((1, 0)), np.eye(1)),
        *(np.zeros((1, 0)), np.zeros((1, 1)), np.ones((1, 1)), (), plays, ()),
    )
    fit = SimpleNamespace(
        mirror=own,
        classes=(0, 1),
        amplitudes=(0.5, 1.0),
        error_rms=np.array([0.02, 0.04]),
        rate_hz=100.0,
        sub_steps=2,
        delay_s=0.0,
        motion=np.array([2.0]),
    )
    asked, steps = [], []

    def responded(mirror, drive, rate_hz, sub_steps, delay_s):
        asked.append((mirror.plays[0].reach_v, rate_hz, sub_steps, delay_s))
        return coupled.response(mirror, drive, rate_hz, sub_steps, delay_s)

    def returned(mirror, step_s):
        steps.append(step_s)
        return 0.999 if step_s < 2e-3 else 1.0

    monkeypatch.setattr(fit_of, "coupled", SimpleNamespace(response=responded))
    monkeypatch.setattr(fit_of, "contraction", returned)
    drive = 4.0 * np.sin(2 * np.pi * np.arange(64) / 64)[:, None]
    found = trust(fit, drive)
    assert steps == pytest.approx([5e-3, 2.5e-3, 1.25e-3])
    assert asked == [(2.0, 100.0, 2, 0.0), (2.0, 100.0, 8, 0.0), (pytest.approx(4.0), 100.0, 8, 0.0)]
    s = drive[:, 0] / 2.0
    assert found.open == pytest.approx(np.sqrt(np.mean((0.1 * (np.clip(s, -1, 1) ** 3 - s**3)) ** 2)), rel=1e-6)
    assert found.left == pytest.approx(0.04 * np.sqrt(8.0)) and found.motion == pytest.approx(2.0)
    assert found.error_rms == pytest.approx(np.hypot(found.left, found.open))


def test_errors_are_judged_record_by_record_and_motions_are_the_largest_of_all(monkeypatch):
    """Three records, two outputs and two operators, the first of which goes farthest the other way."""
    errors = {"a": [[3.0, 4.0], [0.0, 1.0]], "b": [[6.0, 0.0]], "c": [[1.0, 1.0], [1.0, 1.0]]}
    motions = {"a": [[1.0, -2.0], [0.5, 2.5]], "b": [[-4.0, 1.0]], "c": [[3.0, 2.0]]}
    asked = []

    def plant(numbers, step_s):
        asked.append((numbers.delay_s, step_s))
        return "plant"

    def error(own, record, delay_s):
        assert own == "plant" and delay_s == 2e-4
        return np.array(errors[record.name]), SimpleNamespace(q=np.array(motions[record.name])), None

    monkeypatch.setattr(fit_of.tangents, "play_plant", plant)
    monkeypatch.setattr(fit_of.tangents, "steady_error", error)
    search = SimpleNamespace(
        springs=SimpleNamespace(numbers=lambda free: SimpleNamespace(delay_s=free)),
        records=[SimpleNamespace(name=name, step_s=step) for name, step in zip("abc", (0.25, 0.5, 0.75), strict=True)],
        pool=SimpleNamespace(map=map),
    )
    rms, largest = fit_of._judged(search, 2e-4)
    np.testing.assert_allclose(rms, [np.sqrt(26 / 4), np.sqrt(18.0), 1.0])
    assert largest.tolist() == [4.0, 2.5] and asked == [(2e-4, 0.25)]


@pytest.mark.parametrize("classes", [[0, 0, 0, 1], [0, 1, 1, 1], [0, 1, 1, 2]])
def test_a_single_record_in_an_amplitude_leaves_no_error_of_others(classes):
    unseen, moved = fit_of._other_records(SimpleNamespace(records=range(4)), np.zeros(2), classes)
    np.testing.assert_array_equal(unseen, np.full(4, np.nan))
    assert moved is None
