"""Frequency response without a model: accuracy, honest confidence, levels of noise and distortion, refusals."""

import re
from dataclasses import replace

import numpy as np
import pytest

from microrad.core import lti
from microrad.lab.identify.linear.modal import order_modes, simulate
from microrad.lab.identify.linear.response import (
    measure_frequency_response,
    response_from_periods,
    response_from_records,
)
from microrad.lab.identify.records import IdentificationError
from microrad.lab.recording import Recording

RATE_HZ = 10_000.0
PERIOD = 512


def philox(seed):
    return np.random.Generator(np.random.Philox(seed))


def recording(drive, output, period=None, rate_hz=RATE_HZ, name="record"):
    u, y = (a.reshape(len(a), -1) for a in (drive, output))
    names = [tuple(f"{kind}{k}" for k in range(a.shape[1])) for kind, a in (("u", u), ("y", y))]
    return Recording(name, "", u, y, rate_hz, *names, period)


def mirror(channels=1):
    poles = np.array([-300.0 + 0j, -60 + 2 * np.pi * 600j, -150 + 2 * np.pi * 1500j])
    rng = philox(3)
    b = rng.standard_normal((3, channels)) + 1j * rng.standard_normal((3, channels))
    c = 100 * (rng.standard_normal((channels, 3)) + 1j * rng.standard_normal((channels, 3)))
    b[0], c[:, 0] = b[0].real, c[:, 0].real
    return order_modes(poles, b, c, np.zeros((channels, channels)))


def chirp(seconds, low, high):
    t = np.arange(round(seconds * RATE_HZ)) / RATE_HZ
    growth = np.log(high / low) / seconds
    return np.sin(2 * np.pi * low / growth * np.expm1(growth * t))


def multisine(seed, lines=None):
    """Flat random-phase multisine, one period, unit rms."""
    lines = np.arange(1, 200) if lines is None else lines
    spectrum = np.zeros(PERIOD // 2 + 1, dtype=complex)
    spectrum[lines] = np.exp(2j * np.pi * philox(seed).random(len(lines)))
    period = np.fft.irfft(spectrum, PERIOD)
    return period / np.std(period)


def periodic(model, drives, noise=0.0, seed=0, periods=2, cubic=0.0, settle=4):
    """Realisations in steady state: (inputs,) of one-period drives each; a cubic of the output is added to it."""
    records, rng = [], philox(seed + 100)
    for k, drive in enumerate(drives):
        u = np.tile(np.stack(drive, axis=1), (periods + settle, 1))
        y = simulate(model, u, RATE_HZ)[settle * PERIOD :]
        y = y + cubic * y**3 + noise * rng.standard_normal(y.shape)
        records.append(recording(u[settle * PERIOD :], y, PERIOD, name=f"realisation {k}"))
    return records


# ------------------------------------------------------------------------------------------------------------- chirps
@pytest.mark.promise("identify-7")
def test_chirp_with_noise_offset_and_trend():
    model, u = mirror(), chirp(4.0, 2.0, 3000.0)
    y = simulate(model, u[:, None], RATE_HZ)[:, 0]
    noise = 0.03 * np.std(y) * philox(1).standard_normal(y.size)
    trend = 5.0 + np.std(y) * np.linspace(0, 1, y.size)
    found = response_from_records([recording(u, y + noise + trend)])
    exact = model.response(found.freq_hz, "zero-order", RATE_HZ)
    error = np.abs(found.response - exact)
    inside = slice(3, -3)
    relative = np.median(error / np.abs(exact))
    assert 1e-3 < relative < 0.015
    assert 0.8 < np.sqrt(np.mean((error / found.standard_error)[inside] ** 2)) < 1.3
    assert found.excited_hz[0] == pytest.approx(2.0, rel=0.5)
    assert found.excited_hz[1] == pytest.approx(3000.0, rel=0.05)
    assert (found.coherence[:50] > 0.99).all()
    assert found.coherence[-1, 0] < 0.9  # where the mirror hardly answers
    assert (found.coherence <= 1).all()
    assert found.noise_standard_error is None
    left = response_from_records([recording(u, y + noise + trend)], detrend=False)
    worse = np.abs(left.response - model.response(left.freq_hz, "zero-order", RATE_HZ))
    assert worse[0, 0, 0] > 5 * error[0, 0, 0]


def test_a_delay_does_not_bias_the_bands():
    """Ten samples turn the phase by up to 0.3 rad within a band."""
    u = chirp(4.0, 20.0, 3000.0)
    found = response_from_records([recording(u, np.append(np.zeros(10), u[:-10]))])
    exact = np.exp(-2j * np.pi * found.freq_hz * 10 / RATE_HZ)
    error = np.abs(found.response[:, 0, 0] - exact)[2:-2]
    width = np.gradient(found.freq_hz)[2:-2]
    assert error.max() < 0.01
    assert (2 * np.pi * width * 10 / RATE_HZ).max() > 0.25


def test_what_bands_leave_of_a_record_is_no_more_of_two_alike():
    """Powers are of a record, whether one or several were averaged."""
    model, u = mirror(), chirp(2.0, 20.0, 3000.0)
    y = simulate(model, u[:, None], RATE_HZ)[:, 0] + 0.02 * philox(3).standard_normal(u.size)
    one, two = (response_from_records([recording(u, y)] * count, bands=50) for count in (1, 2))
    np.testing.assert_allclose(two.drive_power, one.drive_power, rtol=1e-9)
    # less by the parameter of each band: 1 / (1 - 1 / n) at n lines, and at 2 n
    np.testing.assert_allclose(two.residual_power, one.residual_power, rtol=0.25)
    assert (two.residual_power <= one.residual_power).all()
    assert two.residual_power.sum() > 0.5 * one.residual_power.sum() > 0.0


def test_several_inputs_from_as_many_chirps():
    model, u, still = mirror(2), chirp(2.0, 20.0, 3000.0), np.zeros(20_000)
    drives = [np.stack(pair, axis=1) for pair in ((u, still), (still, u))]
    found = response_from_records([recording(d, simulate(model, d, RATE_HZ)) for d in drives], bands=2000)
    exact = model.response(found.freq_hz, "zero-order", RATE_HZ)
    inside = slice(5, -5)
    assert np.max(np.abs(found.response - exact)[inside]) < 0.03 * np.abs(exact).max()
    assert found.response.shape[1:] == (2, 2)


def test_broadband_noise_on_both_inputs_of_one_record():
    model = mirror(2)
    u = philox(7).standard_normal((40_000, 2))
    found = response_from_records([recording(u, simulate(model, u, RATE_HZ))], band_hz=(50.0, 4000.0))
    exact = model.response(found.freq_hz, "zero-order", RATE_HZ)
    relative = np.linalg.norm(found.response - exact) / np.linalg.norm(exact)
    assert relative < 0.08
    assert found.drive_power.shape == (found.freq_hz.size, 2, 2)


# ---------------------------------------------------------------------------------------------------------- multisines
def test_linear_mirror_without_noise_is_exact():
    model = mirror(2)
    drives = [(multisine(2 * k), multisine(2 * k + 1)) for k in range(3)]
    found = response_from_periods(periodic(model, drives))
    np.testing.assert_allclose(
        found.response, model.response(found.freq_hz, "zero-order", RATE_HZ), atol=1e-6 * np.abs(found.response).max()
    )
    assert found.freq_hz.size == 199
    assert found.excited_hz == (found.freq_hz[0], found.freq_hz[-1])
    assert (found.standard_error < 1e-6 * np.abs(found.response).max()).all()


@pytest.mark.promise("identify-4")
def test_noise_and_distortion_are_told_apart():
    model = mirror()
    scale = np.std(simulate(model, np.tile(multisine(0), 4)[:, None], RATE_HZ))
    drives = [(multisine(k),) for k in range(40)]
    noisy = response_from_periods(periodic(model, drives, noise=0.05 * scale))
    bent = response_from_periods(periodic(model, drives, noise=0.002 * scale, cubic=0.05 / scale**2))
    for found, low, high in ((noisy, 0.0, 0.5), (bent, 0.9, 1.0)):
        share = np.mean(found.distortion_standard_error**2) / np.mean(found.standard_error**2)
        assert low <= share < high + 1e-9
    assert np.mean(bent.noise_standard_error**2) < 0.1 * np.mean(bent.standard_error**2)
    # The scatter between two independent halves is what the standard errors say.
    halves = [response_from_periods(periodic(model, drives[k::2], cubic=0.05 / scale**2)) for k in (0, 1)]
    scatter = np.abs(halves[0].response - halves[1].response) ** 2
    told = halves[0].standard_error ** 2 + halves[1].standard_error ** 2
    assert 0.8 < np.mean(scatter) / np.mean(told) < 1.25


@pytest.mark.parametrize("periods", [2, 8])
def test_the_noise_error_is_the_scatter_of_repetitions(periods):
    """Of the mean over the periods: with more of them it is smaller."""
    model, drives = mirror(), [(multisine(k),) for k in range(3)]
    found = [response_from_periods(periodic(model, drives, noise=0.1, seed=s, periods=periods)) for s in range(40)]
    scatter = np.var([f.response for f in found], axis=0, ddof=1)
    told = np.mean([f.noise_standard_error**2 for f in found], axis=0)
    assert 0.9 < np.mean(scatter) / np.mean(told) < 1.1


def test_powers_add_up_to_the_mean_square():
    model = mirror(2)
    records = periodic(model, [(multisine(2 * k), multisine(2 * k + 1)) for k in range(4)], noise=0.3)
    found = response_from_periods(records)
    power = np.trace(found.drive_power, axis1=1, axis2=2).real.sum()
    assert power == pytest.approx(np.mean([np.sum(r.drive**2) / r.samples for r in records]), rel=1e-9)
    np.testing.assert_allclose(found.residual_power.sum(axis=0), 0.3**2 / 2 * 199 / 256, rtol=0.15)


def test_a_transient_is_dropped_by_periods():
    model = mirror()
    records = periodic(model, [(multisine(k),) for k in range(3)], periods=4, settle=0)
    whole, settled = response_from_periods(records), response_from_periods(records, skip_periods=3)
    exact = model.response(whole.freq_hz, "zero-order", RATE_HZ)
    errors = [np.max(np.abs(f.response - exact)) for f in (whole, settled)]
    assert errors[0] > 100 * errors[1]
    assert settled.noise_standard_error is None


def test_as_many_realisations_as_inputs_leave_only_the_noise():
    model = mirror(2)
    records = periodic(model, [(multisine(0), multisine(1)), (multisine(2), multisine(3))], noise=0.1)
    found = response_from_periods(records)
    assert found.distortion_standard_error is None
    np.testing.assert_array_equal(found.standard_error, found.noise_standard_error)


# ------------------------------------------------------------------------------------------------------------ refusals
def test_records_that_do_not_belong_together():
    u = chirp(1.0, 20.0, 3000.0)
    one = recording(u, u, name="first")
    for other, message in (
        (
            recording(u, u, rate_hz=8000.0, name="second"),
            "second: the sample rate is 8000 Hz and that of first 10000 Hz",
        ),
        (
            recording(np.stack((u, u), axis=1), u, name="second"),
            "second: 2 inputs and 1 outputs, where first has 1 and 1",
        ),
    ):
        for function in (response_from_records, response_from_periods):
            with pytest.raises(IdentificationError, match=message):
                function([one, other])
    with pytest.raises(IdentificationError, match=re.escape("[9000, 10000] samples; cut them to one length")):
        response_from_records([one, recording(u[:9000], u[:9000])])
    for function in (response_from_records, response_from_periods):
        with pytest.raises(IdentificationError, match="no recording was given"):
            function([])


def test_drives_that_cannot_be_told_apart():
    u = chirp(1.0, 20.0, 3000.0)
    same = np.stack((u, 2 * u), axis=1)
    with pytest.raises(
        IdentificationError, match=r"2 inputs are not driven independently at .* give at least 2 records"
    ):
        response_from_records([recording(same, u)])
    with pytest.raises(IdentificationError, match="input 1 is not excited at"):
        response_from_records([recording(np.stack((u, 0 * u), axis=1), u)])
    with pytest.raises(IdentificationError, match="no drive changes in any record"):
        response_from_records([recording(0 * u, u)])
    still = recording(np.ones(2 * PERIOD), multisine(0).repeat(2), PERIOD)
    with pytest.raises(IdentificationError, match="no drive changes in any record"):
        response_from_periods([still, still])


def test_bands_that_do_not_exist():
    u = chirp(0.05, 100.0, 3000.0)
    with pytest.raises(IdentificationError, match="resolves 20 Hz, which leaves fewer than 8 lines; record longer"):
        response_from_records([recording(u, u)], band_hz=(100.0, 200.0))
    for low, high in ((200.0, 100.0), (100.0, 100.0), (0.0, 100.0), (-1.0, 100.0), (1.0, np.inf)):
        with pytest.raises(IdentificationError, match=re.escape(f"band {low:g} to {high:g} Hz is empty; give a lower")):
            response_from_records([recording(u, u)], band_hz=(low, high))


def test_periods_that_do_not_fit():
    records = periodic(mirror(), [(multisine(k),) for k in range(2)])
    with pytest.raises(IdentificationError, match="realisation 1: the record has no period; give period_samples"):
        response_from_periods([records[0], replace(records[1], period_samples=None)])
    with pytest.raises(IdentificationError, match=re.escape("periods of [256, 512] samples; they must agree")):
        response_from_periods([records[0], replace(records[1], period_samples=256)])
    with pytest.raises(IdentificationError, match="hold 2 periods of 512, and 2 are to be dropped"):
        response_from_periods(records, skip_periods=2)
    with pytest.raises(IdentificationError, match="and -1 are to be dropped as transient; drop none or more"):
        response_from_periods(records, skip_periods=-1)
    with pytest.raises(IdentificationError, match="1 records of one usable period for 1 inputs"):
        response_from_periods(records[:1], skip_periods=1)
    two = periodic(mirror(2), [(multisine(0), multisine(1))])
    with pytest.raises(IdentificationError, match="1 records for 2 inputs: at least 2 realisations"):
        response_from_periods(two)


def test_the_response_of_a_state_space_is_the_same():
    """The door to the rest of the package: the sampled response is that of the exact discrete system."""
    model = mirror()
    system = model.state_space()
    Ad, Bd = lti.zero_order_hold(system.A, system.B, 1 / RATE_HZ)
    freq = np.linspace(10, 4000, 20)
    discrete = lti.frequency_response(lti.StateSpace(Ad, Bd, system.C, system.D), freq, 1 / RATE_HZ)
    np.testing.assert_allclose(model.response(freq, "zero-order", RATE_HZ), discrete, rtol=1e-10)


def test_a_band_of_periodic_records_leaves_each_drive_its_size():
    """Two drives, two excited lines: what belongs to the drives is no longer than what belongs to the lines."""
    drives = [(multisine(2 * k, [20, 50]), 3.0 * multisine(2 * k + 1, [20, 50])) for k in range(3)]
    records = periodic(mirror(2), drives, noise=0.01)
    whole = measure_frequency_response(records)
    found = measure_frequency_response(records, band_hz=(900.0, 1100.0))
    np.testing.assert_array_equal(found.freq_hz, whole.freq_hz[1:])
    np.testing.assert_array_equal(found.response, whole.response[1:])
    np.testing.assert_allclose(found.drive_rms, [1.0, 3.0])


@pytest.mark.parametrize(("samples", "last"), [(15, 7), (16, 7)])
def test_the_last_line_of_a_period_of_odd_length_is_no_half_of_the_rate(samples, last):
    pulse = np.zeros(samples)
    pulse[0] = 1.0
    drive = np.tile(pulse, 4)
    found = response_from_periods([recording(drive, 2.0 * np.roll(drive, 1), samples)])
    np.testing.assert_allclose(found.freq_hz, np.arange(1, last + 1) * RATE_HZ / samples)
    np.testing.assert_allclose(found.response[:, 0, 0], 2.0 * np.exp(-2j * np.pi * found.freq_hz / RATE_HZ))
