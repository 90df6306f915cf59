"""One mirror for all amplitudes: exact derivatives, recovery of a known mirror, the real CubeSpec mirror, refusals."""

import itertools
from dataclasses import replace

import numpy as np
import pytest

from microrad.core import kernels
from microrad.core.periodic import delayed
from microrad.lab.identify import fit_hysteretic_stiffness, fit_linear, output_error, predicted_error
from microrad.lab.identify.records import IdentificationError
from microrad.lab.identify.stiffness import fit as stiffness_fit
from microrad.lab.identify.stiffness import tangents
from microrad.lab.identify.stiffness.fit import StiffnessOptions, simulate_hysteretic_stiffness
from microrad.lab.identify.stiffness.model import FIELDS, Numbers, balanced, scaled
from microrad.lab.recording import Recording, multisine_recordings
from microrad.mirror import model as mirror
from microrad.mirror.hysteresis import Play
from microrad.mirror.model import Mirror
from places import DATA

CUBESPEC = DATA / "cubespec"
needs_cubespec = pytest.mark.skipif(not CUBESPEC.exists(), reason=f"real recording cubespec absent: {CUBESPEC}")
RATE_HZ, PERIOD = 1000.0, 512


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
        C=draw((2, 4)),
        D=0.1 * draw((2, 2)),
        K=0.1 * draw((2, 4)),
        thresholds=np.array([[0.0, 0.3, 0.9], [0.1, 0.4, 0.8], [0.2, 0.5, 1.0], [0.3, 0.6, 1.2]]),
        delay_s=3e-4,
    )


STEADY = tangents.Steady("record", multisine(3), np.zeros((PERIOD, 2)), RATE_HZ, 2)


def path_of(numbers):
    plant = tangents.play_plant(numbers, STEADY.step_s)
    drive = tangents.two_periods(STEADY, numbers.delay_s)
    return plant, drive, tangents.simulate_path(plant, drive)


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


def test_tangents_begin_early_enough_for_the_slowest_mode(numbers):
    """Seven of its time constants, where the period has them: what is left out has decayed to a thousandth."""
    slow = replace(numbers, decay=np.array([-3e4, -150.0, -4e4]))
    plant, drive, path = path_of(slow)
    whole = tangents.jacobian(plant, slow, STEADY, (path, drive), np.float64, lead=PERIOD)
    short = tangents.jacobian(plant, slow, STEADY, (path, drive), np.float64)
    missed = np.linalg.norm(short - whole, axis=(0, 1)) / np.linalg.norm(whole, axis=(0, 1))
    assert 0.0 < np.max(missed) < 3e-3


def test_the_scales_of_states_and_operators_change_nothing(numbers):
    plain, other = path_of(numbers)[2].output, path_of(balanced(numbers))[2].output
    np.testing.assert_allclose(other, plain, rtol=0, atol=1e-10)
    assert not np.allclose(balanced(numbers).B, numbers.B)
    assert sum(getattr(numbers, name).size for name in FIELDS) + 1 == numbers.vector().size
    wide = replace(STEADY, drive=10 * STEADY.drive)
    plant = tangents.play_plant(scaled(numbers, 10.0, 3.0), STEADY.step_s)
    output = tangents.simulate_path(plant, tangents.two_periods(wide, numbers.delay_s)).output
    np.testing.assert_allclose(output, 3 * plain, rtol=0, atol=1e-10)


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
    B = np.array([[0.0, 0.0], [-700.0, -600.0], [0.0, 0.0], [-800.0, 900.0]])
    C = np.array([[1.0, 0.0, 0.7, 0.0], [0.8, 0.0, -0.8, 0.0]])
    static = -C @ np.linalg.solve(A, B)
    strain = np.linalg.inv(static) @ C
    weights = (0.01, 0.01, 0.01, 0.01)
    plays = tuple(Play((0.1, 0.3, 0.8, 2.0), tuple(s * w for w in weights)) for s in (1.0, 0.8))
    idle = Play((1.0,), (0.0,))  # as many operators as the fit has: then the kernel compiles once
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
    return [record_of(truth, amplitude, 10 * i + k) for i, amplitude in enumerate((0.3, 0.6, 1.2)) for k in range(3)]


@pytest.fixture(scope="module")
def known(training):
    steps = []
    fit = fit_hysteretic_stiffness(
        training,
        order=4,
        options=StiffnessOptions(sub_steps=4),
        iterations=30,
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


def test_a_known_mirror_is_recovered(known, training):
    fit, steps = known
    assert fit.order == 4 and fit.mirror.A.shape == (4, 4)
    assert [s[0] for s in steps] == list(range(1, fit.iterations + 1)) and steps[0][1] == 30
    assert fit.amplitudes == pytest.approx((0.3, 0.6, 1.2), rel=1e-6)
    assert fit.classes == (0, 0, 0, 1, 1, 1, 2, 2, 2)
    assert all(after < before for before, after in zip(fit.costs, fit.costs[1:], strict=False))
    assert (fit.error_rms < 0.3 * fit.start_error_rms).all()
    assert fit.delay_s == pytest.approx(7e-4, abs=1e-4) and 0 < fit.delay_error_s < 1e-4
    assert fit.poles_rad_s.imag == pytest.approx([900, 1700], rel=0.02)
    assert (fit.poles_error_rad_s.imag > 0).all() and (fit.poles_error_rad_s.imag < 20).all()
    assert fit.parameters == 4 + 4 * (2 + 4 + 4 + 2) + 4 * (2 + 6) + 4 + 8 + 1
    assert fit.redundant == 4 + 4


@pytest.mark.parametrize("amplitude", [0.45, 0.9])
def test_an_amplitude_between_is_predicted_far_better_than_by_a_linear_model(known, straight, amplitude):
    held_out = record_of(hysteretic_truth(), amplitude, 77)
    linear, own = (rms(output_error(fit.modes, held_out, drop=512)) for fit in straight)
    error = rms(predicted_error(known[0], held_out, drop=512))
    assert 0 < error < 0.3 * min(linear, own)
    assert linear < rms(held_out.output)


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


def growths(fit):
    """Largest real part of a pole with the plays of each operator stuck or sliding."""
    m, sums = fit.mirror, [sum(play.weights_rad_v) for play in fit.mirror.plays]
    cases = itertools.product((0.0, 1.0), repeat=len(sums))
    return [np.linalg.eigvals(m.A + m.E @ np.diag(np.multiply(case, sums)) @ m.F).real.max() for case in cases]


def test_no_fit_runs_away_where_its_plays_slide(training):
    """Two modes too many: one of them grew where one operator slid, and the fit was taken for converged."""
    options = StiffnessOptions(delay_s=7e-4, exchanges=0)
    fit = fit_hysteretic_stiffness(training, order=8, options=options, iterations=15)
    assert len(growths(fit)) == 16
    assert max(growths(fit)) < 0.0
    assert fit.costs[-1] < 0.03 * fit.costs[0]
    drive = training[-1].drive[:PERIOD]
    first, second, last = over_periods(fit, drive, 1, 2, 1000)
    assert np.abs(last - second).max() < 1e-3 * np.abs(second).max() < 1e-3 * 2 * np.abs(first).max()
    far, farther, at_rest = over_periods(fit, 10 * drive, 1, 1000, 1100)
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


def test_a_mirror_that_runs_away_is_refused(training, monkeypatch):
    """The play that slides takes more than the stiffness there is: x' = (A + E W F) x has a pole above 0."""

    def minimise(search, start, *_):
        search.numbers = replace(start, weights=500 * start.weights)

    monkeypatch.setattr(stiffness_fit._Search, "minimise", minimise)
    with pytest.raises(IdentificationError, match=r"runs away: where its plays slide it grows by \d.* 1/s.*order"):
        fit_hysteretic_stiffness(training, order=4, options=StiffnessOptions(delay_s=7e-4, exchanges=0))


def test_stuck_and_sliding_plays_in_all_their_combinations(numbers):
    m, sums = numbers.mirror("m"), numbers.weights.sum(axis=1)
    each = [
        np.linalg.eigvals(m.A + m.E @ np.diag(sums * case) @ m.F).real.max()
        for case in itertools.product((0, 1), repeat=4)
    ]
    assert numbers.growth_1_s == pytest.approx(max(each), rel=1e-9)
    assert max(each) > max(each[0], each[-1])
    none, wide = np.zeros((7, 3)), np.zeros((4, 7))
    many = replace(numbers, weights=none, thresholds=none, E=wide, F=wide.T, G=np.zeros((7, 2)), K=np.zeros((2, 7)))
    assert many.growth_1_s == pytest.approx(-30.0)


def test_growth_and_its_slopes_against_differences(numbers):
    """What keeps a step from a mirror that runs away: the fastest poles of each combination, by each number."""
    vector = numbers.vector()
    found = numbers.growths()
    assert len(found) == 3 * 16
    assert max(growth.rate_1_s for growth in found) == pytest.approx(numbers.growth_1_s)
    slopes = np.array([growth.slope for growth in found])
    for i, value in enumerate(vector):
        step = np.zeros(vector.size)
        step[i] = 1e-6 * max(abs(value), 1e-3)
        above, below = ([g.rate_1_s for g in numbers.at(vector + sign * step).growths()] for sign in (1, -1))
        expected = np.subtract(above, below) / (2 * step[i])
        np.testing.assert_allclose(slopes[:, i], expected, rtol=1e-4, atol=1e-4 * max(1.0, np.abs(expected).max()))
    assert np.abs(slopes).max() > 1.0


def test_a_bounded_step_takes_each_pole_half_of_its_way_at_most():
    draw = philox(8).standard_normal
    root = draw((6, 6))
    system = root @ root.T + np.eye(6), 10 * draw(6), np.exp(draw(6))
    slopes = draw((3, 6))
    free, held = stiffness_fit._bounded_move(system, 1e-3, (np.full(3, 1e9), slopes))
    assert not held
    slopes *= np.sign(slopes @ free)[:, None]
    room = slopes @ free * np.array([0.2, 0.3, 2.0])
    move, held = stiffness_fit._bounded_move(system, 1e-3, (room, slopes))
    assert held and (slopes @ free > room * 1.01).any()
    assert (slopes @ move <= room * (1 + 1e-5)).all()
    assert np.linalg.norm(move) > 0.05 * np.linalg.norm(free)


def test_few_records_first_lead_nearly_as_far(training):
    """An iteration on one record of each amplitude costs a third, and most of the error is gone after four."""
    options = StiffnessOptions(delay_s=7e-4, exchanges=0, few_first=4)
    steps = []
    fit = fit_hysteretic_stiffness(
        training, order=4, options=options, iterations=1, on_progress=lambda done, total, _: steps.append((done, total))
    )
    assert steps[-1] == (5, 5) and len(steps) == 5
    assert fit.iterations == 1 and fit.moved.shape == (9, len(fit.names))
    straight = fit_linear(training, 4, exchanges=0)
    linear = [rms(output_error(straight.modes, record, steady=True)) for record in training]
    assert (fit.start_error_rms < 0.5 * np.array(linear)).all()
    assert (fit.error_rms < fit.start_error_rms).any()
    assert fit.names[-1] == "recording.delay" and (fit.moved[:, -1] == 0.0).all()


def test_a_delay_that_is_given_is_kept(training):
    fit = fit_hysteretic_stiffness(training, order=4, options=StiffnessOptions(delay_s=5e-4), iterations=1)
    assert fit.delay_s == 5e-4 and fit.delay_error_s == 0
    assert fit.iterations == 1 and not fit.converged


# ------------------------------------------------------------------------------------------------------------- CubeSpec
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
        options=StiffnessOptions(("strain",), (0.01, 0.1, 0.5), delay_s=1 / 6400, exchanges=0),
        iterations=3,
    )
    linear = fit_linear(train, 12, exchanges=0)
    ratios = [rms(predicted_error(fit, r, drop=1000)) / rms(output_error(linear.modes, r, drop=1000)) for r in held_out]
    assert 0.1 < min(ratios) < max(ratios) < 0.95
    assert np.prod(ratios) < 0.65


# ------------------------------------------------------------------------------------------------------------- refusals
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
        ({"output": np.zeros((1024, 1))}, r"0\.6 V, 10: 2 inputs and 1 outputs, where 0\.3 V, 0 has 2 and 2"),
        ({"drive": np.zeros((1024, 2))}, r"0\.6 V, 10: the drive does not change; excite"),
    ],
)
def test_a_record_that_does_not_fit_is_named(training, change, message):
    with pytest.raises(IdentificationError, match=message):
        fit_hysteretic_stiffness([training[0], replace(training[3], **change)])


def test_other_arguments_that_cannot_be(training, known):
    with pytest.raises(IdentificationError, match="no recording"):
        fit_hysteretic_stiffness([])
    with pytest.raises(IdentificationError, match=r"\[0\.3, 0\.1\] do not ascend from 0"):
        fit_hysteretic_stiffness(training, options=StiffnessOptions(thresholds=(0.3, 0.1)))
    with pytest.raises(IdentificationError, match="no source of hysteresis"):
        fit_hysteretic_stiffness(training, options=StiffnessOptions(sources=()))
    with pytest.raises(IdentificationError, match="0 steps a sample"):
        fit_hysteretic_stiffness(training, options=StiffnessOptions(sub_steps=0))
    with pytest.raises(IdentificationError, match=r"at 2000 Hz, where the model has 2 and 2 at 1000 Hz"):
        predicted_error(known[0], replace(training[0], rate_hz=2000.0))
