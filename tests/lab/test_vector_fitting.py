"""Vector fitting and the modal form behind each hold: exact recoveries, stability, and refusals."""

from dataclasses import replace

import numpy as np
import pytest

from microrad.core import lti
from microrad.lab.identify.linear import modal, vector_fitting
from microrad.lab.identify.linear.modal import (
    ModalModel,
    filtered,
    hold_basis,
    hold_step,
    late,
    order_modes,
    rank_one_modes,
    simulate,
    simulate_periodic,
)
from microrad.lab.identify.linear.vector_fitting import vector_fit
from microrad.lab.identify.records import IdentificationError

EQ2 = ((1.979e11, 7.051e13, 2.973e13), (1, 2.15e4, 3.737e8, 2.615e12, 8.489e14, 1.829e14))
RATE_HZ = 50_000.0
BAND_HZ = np.geomspace(1, 5000, 200)
HOLDS = ("zero-order", "first-order", "band-limited")


def philox(seed):
    return np.random.Generator(np.random.Philox(seed))


def sampled_response(system, freq_hz, hold, rate_hz=RATE_HZ):
    """The response behind a hold from the matrix exponential, which knows nothing of modes."""
    if hold == "band-limited":
        return lti.frequency_response(system, freq_hz)
    Ad, B0, B1 = lti.first_order_hold(system.A, system.B, 1 / rate_hz)
    if hold == "zero-order":
        B0, B1 = B0 + B1, 0 * B1
    z = np.exp(2j * np.pi * freq_hz / rate_hz)
    return np.stack([system.C @ np.linalg.solve(p * np.eye(system.order) - Ad, B0 + p * B1) + system.D for p in z])


def mirror(seed=0, modes=4, channels=2):
    """A lightly damped system with `modes` pairs and one real pole, rank one each."""
    rng = philox(seed)
    freq = np.linspace(200, 2000, modes)
    poles = np.append(-2 * np.pi * 50 + 0j, 2 * np.pi * freq * (-0.02 + 1j))
    b = rng.standard_normal((modes + 1, channels)) + 1j * rng.standard_normal((modes + 1, channels))
    c = (rng.standard_normal((channels, modes + 1)) + 1j * rng.standard_normal((channels, modes + 1))) * 100
    b[0], c[:, 0] = b[0].real, c[:, 0].real
    return order_modes(poles, b, c, rng.standard_normal((channels, channels)))


# ------------------------------------------------------------------------------------------------------------ the fit
@pytest.mark.parametrize("hold", HOLDS)
def test_eq2_is_recovered_exactly_behind_each_hold(hold):
    eq2 = lti.modal_from_polynomials(*EQ2)
    data = sampled_response(eq2, BAND_HZ, hold)
    fit = vector_fit(BAND_HZ, data, 5, weight=1 / np.abs(data), hold=hold, rate_hz=RATE_HZ)
    assert fit.rms_error < 1e-12
    assert fit.converged
    np.testing.assert_allclose(fit.response(BAND_HZ), data, rtol=1e-10)
    np.testing.assert_allclose(np.sort(np.abs(fit.poles_rad_s)), np.sort(np.abs(np.linalg.eigvals(eq2.A))), rtol=1e-7)
    modes = fit.modes()
    assert (modes.order, modes.real_poles) == (5, 3)
    exact = lti.frequency_response(eq2, BAND_HZ)
    np.testing.assert_allclose(lti.frequency_response(modes.state_space(), BAND_HZ), exact, rtol=1e-9)


@pytest.mark.promise("identify-13")
def test_a_wrong_hold_leaves_its_half_sample():
    eq2 = lti.modal_from_polynomials(*EQ2)
    held = sampled_response(eq2, BAND_HZ, "zero-order")
    fit = vector_fit(BAND_HZ, held, 5, weight=1 / np.abs(held))
    error = lti.frequency_response(fit.modes().state_space(), BAND_HZ) / lti.frequency_response(eq2, BAND_HZ) - 1
    assert 0.2 < np.abs(error[-1, 0, 0]) < 0.4  # 2 sin(pi f / 2 rate) = 0.31 at 5 kHz
    assert np.abs(error[0, 0, 0]) < 1e-3


@pytest.mark.promise("identify-13")
def test_another_hold_is_half_a_sample_of_delay_and_bends_the_response_above_a_tenth_of_the_rate():
    slow, rate = lti.modal_from_polynomials((1.0,), (1e-3, 1.0)), 50_000.0
    freq = np.array([0.001, 0.03, 0.09, 0.2, 0.3]) * rate
    held, straight = (sampled_response(slow, freq, hold)[:, 0, 0] for hold in HOLDS[:2])
    apart = held / straight
    assert np.abs(np.angle(apart * np.exp(1j * np.pi * freq / rate)))[:3].max() < 0.01
    bent = np.abs(np.abs(apart) - 1.0)
    assert bent[:3].max() < 0.05
    assert bent[3:].min() > 0.1


def test_several_channels_share_their_poles():
    truth = mirror()
    freq = np.linspace(5, 2500, 500)
    fit = vector_fit(freq, truth.response(freq, "zero-order", 10_000.0), 9, hold="zero-order", rate_hz=10_000.0)
    assert fit.residues.shape == (9, 2, 2)
    np.testing.assert_allclose(
        np.sort_complex(fit.poles_rad_s), np.sort_complex(truth.all_poles_rad_s), rtol=1e-8, atol=1e-4
    )
    np.testing.assert_allclose(fit.direct, truth.direct, atol=1e-9)
    for residue in fit.residues:
        size = np.linalg.svd(residue, compute_uv=False)
        assert size[1] < 1e-7 * size[0]
    modes = fit.modes()
    assert modes.order >= truth.order  # rank-one up to rounding
    np.testing.assert_allclose(modes.response(freq), truth.response(freq), rtol=1e-7)


def test_poles_are_stable_even_where_the_data_are_not():
    freq = np.geomspace(1, 100, 60)
    s = 2j * np.pi * freq
    unstable = 1 / (s - 50.0) + 1 / (s + 200.0)
    fit = vector_fit(freq, unstable, 2)
    assert (fit.poles_rad_s.real < 0).all()
    assert fit.rms_error > 1e-3
    stable = vector_fit(freq, 1 / (s + 50.0) + 1 / (s + 200.0), 2)
    np.testing.assert_allclose(np.sort(stable.poles_rad_s.real), [-200, -50], rtol=1e-9)


def test_strictly_proper():
    freq = np.geomspace(1, 100, 60)
    data = 3.0 / (2j * np.pi * freq + 100.0) + 0.5
    free = vector_fit(freq, data, 1)
    proper = vector_fit(freq, data, 1, strictly_proper=True)
    assert free.direct[0, 0] == pytest.approx(0.5, abs=1e-9)
    assert proper.direct[0, 0] == 0.0
    assert proper.rms_error > 100 * free.rms_error


def test_weights_decide_where_the_error_is():
    eq2 = lti.modal_from_polynomials(*EQ2)
    data = lti.frequency_response(eq2, BAND_HZ)
    relative, plain = (vector_fit(BAND_HZ, data, 3, weight=w) for w in (1 / np.abs(data), None))
    high = BAND_HZ > 4000
    error = [np.max(np.abs(fit.response(BAND_HZ)[high] / data[high] - 1)) for fit in (relative, plain)]
    assert error[0] < error[1]
    same = vector_fit(BAND_HZ, data, 3, weight=np.full(BAND_HZ.size, 7.0))
    np.testing.assert_allclose(same.response(BAND_HZ), plain.response(BAND_HZ), rtol=1e-6)
    assert same.rms_error == pytest.approx(7 * plain.rms_error, rel=1e-6)


@pytest.mark.parametrize(
    ("freq", "order", "words", "message"),
    [
        (BAND_HZ, 0, {}, "order is 0"),
        (BAND_HZ[:4], 5, {}, "4 frequencies cannot fix 5 poles; give at least 6"),
        (BAND_HZ, 5, {"hold": "zero-order"}, "zero-order hold needs the sample rate"),
        (BAND_HZ, 5, {"hold": "zero-order", "rate_hz": 10_000.0}, "reaches 5000 Hz, half the sample rate of 10000 Hz"),
    ],
)
def test_refusals(freq, order, words, message):
    with pytest.raises(IdentificationError, match=message):
        vector_fit(freq, np.ones(freq.size, dtype=complex), order, **words)


def test_a_response_that_is_not_finite_is_refused():
    data = np.ones(BAND_HZ.size, dtype=complex)
    data[3] = np.nan
    with pytest.raises(IdentificationError, match=f"at {BAND_HZ[3]:g} Hz is not finite"):
        vector_fit(BAND_HZ, data, 2)


# ------------------------------------------------------------------------------------------------------- the modal form
@pytest.mark.parametrize("hold", HOLDS)
def test_modal_response_is_that_of_the_state_space(hold):
    model = mirror()
    freq = np.linspace(1, 4000, 50)
    np.testing.assert_allclose(
        model.response(freq, hold, 10_000.0), sampled_response(model.state_space(), freq, hold, 10_000.0), rtol=1e-10
    )


@pytest.mark.parametrize("hold", HOLDS)
def test_a_hold_between_samples_needs_their_rate(hold):
    if hold == "band-limited":
        assert mirror().response(BAND_HZ, hold).shape[0] == BAND_HZ.size
    else:
        with pytest.raises(IdentificationError, match=f"a {hold} hold needs the sample rate; give rate_hz"):
            mirror().response(BAND_HZ, hold)


@pytest.mark.parametrize("hold", HOLDS)
@pytest.mark.parametrize("pole", [-3.0, -1e3, -2e4, -2e5, -100 + 3000j, -1e5 + 1e5j])
def test_derivative_by_the_pole(hold, pole):
    step = 1e-6 * abs(pole)
    ends = [hold_basis(np.array([pole + s]), BAND_HZ, hold, RATE_HZ)[0] for s in (step, -step)]
    basis, slope = hold_basis(np.array([pole]), BAND_HZ, hold, RATE_HZ)
    np.testing.assert_allclose((ends[0] - ends[1]) / (2 * step), slope, rtol=1e-5)
    alone, none = hold_basis(np.array([pole]), BAND_HZ, hold, RATE_HZ, rates=False)
    np.testing.assert_array_equal(alone, basis)
    assert none is None


@pytest.mark.parametrize("hold", HOLDS[:2])
def test_simulation_is_the_exact_discrete_system(hold):
    model, rate = mirror(), 8000.0
    system = model.state_space()
    Ad, B0, B1 = lti.first_order_hold(system.A, system.B, 1 / rate)
    if hold == "zero-order":
        B0, B1 = B0 + B1, 0 * B1
    u = philox(1).standard_normal((300, 2))
    x, expected = np.zeros(system.order), []
    for k in range(len(u)):
        expected.append(system.C @ x + system.D @ u[k])
        x = Ad @ x + B0 @ u[k] + B1 @ u[min(k + 1, len(u) - 1)]
    np.testing.assert_allclose(simulate(model, u, rate, hold), expected, atol=1e-10)


@pytest.mark.parametrize("hold", HOLDS[:2])
def test_filtered_derivatives(hold):
    poles = np.array([-500.0 + 0j, -200 + 4000j])
    u = philox(1).standard_normal((200, 2))
    slopes = filtered(poles, u, hold, 8000.0, rates=True)[1]
    for direction in (1.0, 1j):
        chosen = np.array([direction == 1.0, True])
        ends = [filtered(poles + s * direction * chosen, u, hold, 8000.0)[0] for s in (1e-3, -1e-3)]
        change = (ends[0] - ends[1]) / 2e-3
        np.testing.assert_allclose(change[chosen], (direction * slopes)[chosen], atol=1e-6 * np.abs(slopes).max())


@pytest.mark.parametrize("samples", [500, 501])
def test_periodic_simulation_is_where_the_transient_ends(samples):
    model = mirror()
    period = philox(2).standard_normal((samples, 2))
    steady = simulate_periodic(model, period, 8000.0)
    long = simulate(model, np.tile(period, (20, 1)), 8000.0)
    np.testing.assert_allclose(long[-samples:], steady, atol=1e-6 * np.abs(steady).max())
    assert np.max(np.abs(long[:samples] - steady)) > 0.01 * np.abs(steady).max()


def test_band_limited_cannot_be_stepped():
    with pytest.raises(IdentificationError, match="cannot be stepped from sample to sample"):
        hold_step(np.array([-1.0 + 0j]), "band-limited", 100.0)
    model = ModalModel(np.array([-1.0 + 0j]), np.ones((1, 1), complex), np.ones((1, 1), complex), np.zeros((1, 1)))
    assert simulate(model, np.ones((5, 1)), 100.0).shape == (5, 1)
    with pytest.raises(IdentificationError, match="choose the zero-order hold"):
        simulate(model, np.ones((5, 1)), 100.0, "band-limited")


@pytest.mark.parametrize("factor", [2.0**-50, 1.0, 2.0**50])
def test_a_fit_ends_when_it_is_exact_whatever_the_size_of_its_weights(factor):
    freq = np.geomspace(1.0, 4000.0, 300)
    truth = mirror(seed=3).response(freq)
    fit = vector_fit(freq, truth, 9, weight=np.full(freq.size, factor))
    assert fit.converged
    assert 1 < fit.iterations < 30
    np.testing.assert_allclose(fit.response(freq), truth, rtol=1e-8, atol=1e-8 * np.abs(truth).max())


# ------------------------------------------------------------------------------------------ numbers unlike each other
def told(function, *given, **words):
    with pytest.raises(IdentificationError) as caught:
        function(*given, **words)
    return str(caught.value)


def test_what_a_vector_fit_cannot_use_is_told_in_full():
    freq, flat = np.array([1.0, 2.5, 4.0, 8.0]), np.ones((4, 2, 3), dtype=complex)
    spoilt = flat.copy()
    spoilt[2, 1, 2] = spoilt[3, 0, 0] = np.nan
    assert told(vector_fit, freq, spoilt, 2) == "the response at 4 Hz is not finite; leave it out."
    assert told(vector_fit, freq, flat, 4) == (
        "4 frequencies cannot fix 4 poles; give at least 5 frequencies or a lower order."
    )
    assert told(vector_fit, freq, flat, -3) == "the order is -3; give at least one pole."
    assert told(vector_fit, freq, flat, 2, hold="first-order") == (
        "a first-order hold needs the sample rate; give rate_hz."
    )
    assert told(vector_fit, freq[::-1], flat, 2, hold="zero-order", rate_hz=16.0) == (
        "the response reaches 8 Hz, half the sample rate of 16 Hz or more; leave that out."
    )


def test_poles_begin_as_dense_as_the_frequencies():
    freq = np.array([40.0, 1.0, 3.0, 10.0, 4.0])
    found = vector_fitting.starting_poles(freq, 5) / (2 * np.pi)
    np.testing.assert_allclose(found[0], -4.0)
    np.testing.assert_allclose(found[1:3], np.array([3.0, 10.0]) * (-0.01 + 1j))
    np.testing.assert_allclose(found[3:], found[1:3].conj())
    assert vector_fitting.starting_poles(freq, 1).tolist() == [-8 * np.pi]
    assert vector_fitting.starting_poles(freq, 2)[0] == pytest.approx(2 * np.pi * 4.0 * (-0.01 + 1j))


def test_poles_are_real_ones_first_then_each_upper_half_and_its_conjugate():
    given = np.array([-3 + 5j, -1.0, -2 - 7j, -9.0 + 1e-9j, -3 - 5j, -2 + 7j])
    found = vector_fitting._symmetric(given)
    assert found.tolist() == [-9.0, -1.0, -3 + 5j, -2 + 7j, -3 - 5j, -2 - 7j]


def test_a_pole_goes_through_the_plane_of_its_rate_and_back():
    poles = np.array([-30.0 + 200j, -400.0, -1e-9])
    plane = vector_fitting._to_plane(poles, 100.0)
    np.testing.assert_allclose(plane, 100.0 * np.expm1(poles / 100.0))
    np.testing.assert_allclose(vector_fitting._to_pole(plane, 100.0), poles, rtol=1e-9, atol=1e-12)
    assert vector_fitting._to_pole(np.array([-150.0 + 0j, -100.0]), 100.0) == pytest.approx(
        [100.0 * np.log(0.5), 100.0 * np.log(1e-12)]
    )
    assert vector_fitting._to_plane(poles, None) is poles is vector_fitting._to_pole(poles, None)


def test_how_far_poles_have_moved_is_counted_in_their_decays():
    before = np.array([-5.0 + 0j, -2 + 30j, -2 - 30j])
    after = np.array([-4.0 + 0j, -2.5 + 30j, -2.5 - 30j])
    of_pair = abs(abs(-2 + 30j) - abs(-2.5 + 30j)) / 2.5 + 0.2
    of_real = 0.25 + 0.25
    assert vector_fitting._moved_by(before, after) == pytest.approx(max(of_pair, of_real))
    assert vector_fitting._moved_by(before, np.array([-4.0 + 0j, -2.5, -3.0])) == np.inf
    assert vector_fitting._moved_by(before, before[[2, 1, 0]][::-1]) == 0.0


def test_residues_of_several_elements_have_the_rank_of_their_modes():
    poles = np.array([-3.0 + 0j, -1 + 9j])
    residues = np.array([[[2.0, -4.0, 6.0], [1.0, -2.0, 3.0]], [[1 + 1j, 0.0, 2.0], [0.0, 3.0, 1j]]])
    direct = np.arange(6.0).reshape(2, 3)
    model = rank_one_modes(poles, residues, direct)
    assert (model.poles_rad_s.tolist(), model.order, model.real_poles) == ([-3.0, -1 + 9j, -1 + 9j], 5, 1)
    s = np.array([0.5j, 4j])
    expected = direct + sum(
        r / (s[:, None, None] - p)
        for p, r in [(-3.0, residues[0]), (-1 + 9j, residues[1]), (-1 - 9j, residues[1].conj())]
    )
    np.testing.assert_allclose(model.response(s.imag / (2 * np.pi)), expected, rtol=1e-12)
    np.testing.assert_allclose(
        np.linalg.norm(model.input_vectors, axis=1), np.linalg.norm(model.output_vectors, axis=0)
    )
    assert rank_one_modes(poles, residues, direct, most=1).poles_rad_s.tolist() == [-3.0, -1 + 9j]
    found = model.state_space()
    np.testing.assert_allclose(
        [found.C @ np.linalg.solve(v * np.eye(5) - found.A, found.B) + found.D for v in s], expected, rtol=1e-12
    )


def test_modes_are_ordered_real_ones_first_then_by_frequency_and_each_is_balanced():
    poles = np.array([-1 + 20j, -50.0, -2 + 3j, -0.5])
    inputs = np.array([[3.0, 4.0], [0.0, 2.0], [0.0, 0.0], [1.0, 0.0]], dtype=complex)
    outputs = np.array([[20.0, 8.0, 7.0, 0.0]], dtype=complex)
    model = order_modes(poles, inputs, outputs, np.zeros((1, 2)))
    assert model.poles_rad_s.tolist() == [-0.5, -50.0, -2 + 3j, -1 + 20j]
    np.testing.assert_allclose(model.input_vectors, [[1.0, 0.0], [0.0, 4.0], [0.0, 0.0], [6.0, 8.0]])
    np.testing.assert_allclose(model.output_vectors, [[0.0, 4.0, 7.0 / np.sqrt(7.0), 10.0]])


@pytest.mark.parametrize("samples", [2.0, -3.0, 0.5, 1.25, -0.75])
def test_a_polynomial_is_late_exactly_and_rests_before_its_begin_and_behind_its_end(samples):
    time = np.arange(60.0)
    signal = np.column_stack([1 + 0.1 * time, (time / 30 - 1) ** 5])
    found = late(signal, samples)
    inner = slice(15, 45)
    at = time - samples
    np.testing.assert_allclose(found[inner], np.column_stack([1 + 0.1 * at, (at / 30 - 1) ** 5])[inner], atol=1e-9)
    assert found.shape == signal.shape
    if samples == 2.0:
        assert found[:3, 0].tolist() == pytest.approx([1.0, 1.0, 1.0])
    if samples == -3.0:
        assert found[-4:, 0].tolist() == pytest.approx([signal[-1, 0]] * 4)


def test_a_delayed_model_simulates_later_whether_it_repeats_or_not():
    """Two outputs and a direct term; the delay is two and a half samples."""
    poles = np.array([-40.0 + 0j, -20 + 300j])
    model = ModalModel(poles, np.array([[2.0], [1 + 1j]]), np.array([[3.0, 1j], [0.5, 2.0]]), np.array([[0.3], [-0.2]]))
    turn = 2 * np.pi * np.arange(200) / 200
    drive = (np.sin(3 * turn) + 0.5 * np.cos(7 * turn + 1.0))[:, None]
    whole = np.tile(drive, (4, 1))
    for hold in ("zero-order", "first-order"):
        plain = simulate(model, whole, 1000.0, hold)
        behind = simulate(replace(model, delay_s=2.5e-3), whole, 1000.0, hold)
        np.testing.assert_allclose(behind[100:780], late(plain, 2.5)[100:780], atol=1e-9)
        periodic = simulate_periodic(replace(model, delay_s=2.5e-3), drive, 1000.0, hold)
        np.testing.assert_allclose(behind[600:780], periodic[:180], atol=1e-4)
        assert behind.shape == (800, 2)


@pytest.mark.parametrize("pole", [-0.3, -1e-7, 0.2 + 0.4j, -3 + 2j, -0.4999j, -0.5001j])
def test_functions_of_a_step_are_those_of_their_integrals(pole):
    """phi1 is the mean of e^(a x) over the step, and phi2 that with the weight 1 - x; the slopes take x e^(a x)."""
    x, weights = np.polynomial.legendre.leggauss(40)
    x, weights = (x + 1) / 2, weights / 2
    grown = np.exp(pole * x)
    expected = [
        np.exp(pole),
        weights @ grown,
        weights @ (x * grown),
        weights @ ((1 - x) * grown),
        weights @ ((1 - x) * x * grown),
    ]
    np.testing.assert_allclose([v[0] for v in modal._phi(np.array([pole], dtype=complex))], expected, rtol=1e-11)


@pytest.mark.parametrize(
    ("freq", "order", "poles"),
    [
        ([0.0, 2.0, 10.0, 30.0, 80.0], 1, [-10.0]),
        ([0.0, 2.0, 10.0, 30.0, 80.0], 2, [10.0 * (-0.01 + 1j)]),
        ([80.0, 2.0, 10.0, 0.0, 30.0], 3, [-10.0, 10.0 * (-0.01 + 1j)]),
        ([0.0, 2.0, 10.0, 30.0, 80.0], 5, [-10.0, 2.0 * (-0.01 + 1j), 30.0 * (-0.01 + 1j)]),
        ([1.0, 2.0, 4.0, 8.0], 7, [-3.0, 1.5 * (-0.01 + 1j), 3.0 * (-0.01 + 1j), 6.0 * (-0.01 + 1j)]),
    ],
)
def test_poles_begin_at_the_middle_of_equal_parts_of_the_frequencies(freq, order, poles):
    found = vector_fitting.starting_poles(np.array(freq), order) / (2 * np.pi)
    upper = [p for p in poles if np.imag(p)]
    np.testing.assert_allclose(found, [*(p for p in poles if not np.imag(p)), *upper, *np.conj(upper)], rtol=1e-12)


@pytest.mark.parametrize(
    ("before", "after", "moved"),
    [
        ([-1, -5 + 30j], [-1, -5 + 30j], 0.0),
        ([-40, -5 + 3j], [-50, -5 + 3j], 0.4),
        ([-40, -5 + 3j], [-40, -4 + 3j], np.sqrt(34.0) / 4 - 1.25 + 0.25),
        ([-2, -40], [-40, -4], 1.0),
        ([-1, -2, -3 + 9j], [-1 + 1j, -3 + 9j], np.inf),
        ([-40, -7 + 1j, -8 + 30j], [-44, -7 + 1j, -8 + 30j], 8 / 44),
    ],
)
def test_real_poles_are_compared_with_real_ones_and_pairs_with_pairs(before, after, moved):
    def whole(poles):
        return np.array([q for p in poles for q in ((p, np.conj(p)) if np.imag(p) else (p,))], dtype=complex)

    assert vector_fitting._moved_by(whole(before), whole(after)) == pytest.approx(moved, rel=1e-9, abs=1e-12)


@pytest.mark.parametrize(
    ("count", "order", "message"),
    [
        (5, 4, None),
        (5, 5, "5 frequencies cannot fix 5 poles; give at least 6 frequencies or a lower order."),
        (5, 9, "5 frequencies cannot fix 9 poles; give at least 10 frequencies or a lower order."),
        (5, 0, "the order is 0; give at least one pole."),
        (0, -3, "the order is -3; give at least one pole."),
    ],
)
def test_an_order_needs_a_frequency_more(count, order, message):
    if message:
        assert told(vector_fitting.check_order, np.arange(count), order) == message
    else:
        assert vector_fitting.check_order(np.arange(count), order) is None


@pytest.mark.parametrize(
    ("hold", "rate_hz", "last", "message"),
    [
        ("band-limited", None, 1.0, None),
        ("band-limited", 7.0, 1.0, None),
        ("zero-order", 8.5, 1.0, None),
        ("zero-order", None, 1.0, "a zero-order hold needs the sample rate; give rate_hz."),
        ("first-order", None, 1.0, "a first-order hold needs the sample rate; give rate_hz."),
        (
            "first-order",
            8.0,
            1.0,
            "the response reaches 4 Hz, half the sample rate of 8 Hz or more; leave that out.",
        ),
        ("band-limited", None, np.nan, "the response at 4 Hz is not finite; leave it out."),
        ("zero-order", 8.0, np.inf, "the response at 4 Hz is not finite; leave it out."),
    ],
)
def test_a_response_that_a_hold_cannot_have_is_told_in_full(hold, rate_hz, last, message):
    freq, data = np.array([1.0, 2.5, 4.0]), np.ones((3, 2), dtype=complex)
    data[2, 1] = last
    if message:
        assert told(vector_fitting._check, freq, 2, data, hold, rate_hz) == message
    else:
        assert vector_fitting._check(freq, 2, data, hold, rate_hz) is None


def test_pairs_that_change_places_have_not_moved():
    one, two = (np.array([-2.0, *pairs, *np.conj(pairs)]) for pairs in ([-3 + 4j, -1 + 90j], [-1 + 90j, -3 + 4j]))
    assert vector_fitting._moved_by(one, two) == 0.0
    assert vector_fitting._moved_by(one, one * 1.01) > 0.01
