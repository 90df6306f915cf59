"""Vector fitting and the modal form behind each hold: exact recoveries, stability, and refusals."""

import numpy as np
import pytest

from microrad.core import lti
from microrad.lab.identify.linear.modal import (
    ModalModel,
    filtered,
    hold_basis,
    hold_step,
    order_modes,
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
