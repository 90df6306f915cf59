"""Frequency response without a model: accuracy, honest confidence, levels of noise and distortion, refusals."""

import re
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from microrad.core import lti
from microrad.lab.identify.linear import response
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
            "second: 2 inputs and 1 output, where first has 1 and 1",
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
    with pytest.raises(IdentificationError, match="1 record of one usable period for 1 input leaves nothing"):
        response_from_periods(records[:1], skip_periods=1)
    two = periodic(mirror(2), [(multisine(0), multisine(1))])
    with pytest.raises(IdentificationError, match="1 record for 2 inputs: at least 2 realisations"):
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


# ------------------------------------------------------------------------------------------ numbers unlike each other
def told(function, *given, **words):
    with pytest.raises(IdentificationError) as caught:
        function(*given, **words)
    return str(caught.value)


def drawn(samples, inputs, outputs, seed, *, rate_hz=640.0, period=None, name="r"):
    """A record of noise; every number its own."""
    drive, output = (
        philox(seed).standard_normal((samples, inputs)),
        philox(seed + 50).standard_normal((samples, outputs)),
    )
    return recording(drive, output, period, rate_hz, name)


def test_the_third_record_may_differ_in_its_rate_or_in_the_number_of_its_outputs_alone():
    first, second = drawn(40, 2, 3, 1, name="a"), drawn(40, 2, 3, 2, name="b")
    other = drawn(40, 2, 3, 3, rate_hz=640.5, name="c")
    assert told(response.check_alike, [first, second, other], "judged") == (
        "c: the sample rate is 640.5 Hz and that of a 640 Hz; records that are judged together must share one rate."
    )
    assert told(response.check_alike, [first, second, drawn(40, 2, 1, 3, name="c")], "judged") == (
        "c: 2 inputs and 1 output, where a has 2 and 3; choose the same channels in each record."
    )
    assert response.check_alike([first, second], "judged") is None


@pytest.mark.parametrize("skip", [0, 1])
def test_lines_of_two_drives_are_solved_over_three_realisations_of_unlike_length(skip):
    """By the pseudo-inverse of each line, over the periods that all records have."""
    records = [drawn(n, 2, 2, seed, period=16) for n, seed in ((64, 1), (70, 2), (48, 3), (64, 4))]
    found = response_from_periods(records, skip_periods=skip)
    periods = 3 - skip
    parts = [slice(16 * p, 16 * p + 16) for p in range(skip, 3)]
    drive, output = (
        np.array([[np.fft.rfft(getattr(r, of)[part], axis=0) for part in parts] for r in records]) * np.sqrt(2.0) / 16
        for of in ("drive", "output")
    )
    assert found.freq_hz.tolist() == [40.0 * k for k in range(1, 8)]
    assert found.method == f"best linear approximation, realisations: 4, periods of each: {periods}"
    assert found.excited_hz == (40.0, 280.0) and (found.rate_hz, found.hold) == (640.0, "zero-order")
    u, y = drive.mean(axis=1), output.mean(axis=1)
    for at, line in enumerate(range(1, 8)):
        gain = (np.linalg.pinv(u[:, line]) @ y[:, line]).T
        np.testing.assert_allclose(found.response[at], gain, rtol=1e-9)
        left = y[:, line] - u[:, line] @ gain.T
        variance = np.sum(np.abs(left) ** 2, axis=0) / 2
        auto = u[:, line].T @ u[:, line].conj()
        spread = np.diag(np.linalg.inv(auto)).real
        np.testing.assert_allclose(found.standard_error[at], np.sqrt(np.outer(variance, spread)), rtol=1e-9)
        np.testing.assert_allclose(found.residual_power[at], variance, rtol=1e-9)
        np.testing.assert_allclose(found.drive_power[at], auto / 4, rtol=1e-9)
        coherence = 1 - 4 * variance / np.sum(np.abs(y[:, line]) ** 2, axis=0)
        np.testing.assert_allclose(found.coherence[at], np.clip(coherence, 0, 1), rtol=1e-9)
        rest = output[:, :, line] - drive[:, :, line] @ gain.T
        noise = np.mean(np.var(rest, axis=1, ddof=1), axis=0) / periods
        np.testing.assert_allclose(found.noise_standard_error[at], np.sqrt(np.outer(noise, spread)), rtol=1e-9)
    distortion = np.maximum(found.standard_error**2 - found.noise_standard_error**2, 0)
    np.testing.assert_allclose(found.distortion_standard_error, np.sqrt(distortion), rtol=1e-7, atol=1e-12)
    np.testing.assert_allclose(found.drive_rms, np.sqrt(np.mean([r.drive.var(axis=0) for r in records], axis=0)))


def test_one_period_of_more_realisations_than_drives_tells_no_noise():
    found = response_from_periods([drawn(16, 2, 1, seed, period=16) for seed in (1, 2, 3)])
    assert found.noise_standard_error is None and found.distortion_standard_error is None
    assert (found.standard_error > 0).all()


def test_bands_of_two_drives_are_solved_over_both_records():
    records = [drawn(400, 2, 2, seed) for seed in (1, 2)]
    found = response_from_records(records, band_hz=(20.0, 200.0), bands=4, detrend=False)
    marks = np.round(np.geomspace(20.0, 200.0, 5) / 1.6).astype(int)
    spectra = [
        [np.fft.rfft(v - v.mean(axis=0), axis=0) * np.sqrt(2.0) / 400 for v in (r.drive, r.output)] for r in records
    ]
    for at, (begin, end) in enumerate(pairwise(marks)):
        u, y = (np.vstack([each[k][begin:end] for each in spectra]) for k in (0, 1))
        gain = (np.linalg.pinv(u) @ y).T
        np.testing.assert_allclose(found.response[at], gain, rtol=1e-9)
        left = np.sum(np.abs(y - u @ gain.T) ** 2, axis=0)
        variance = left / (2 * (end - begin) - 2)
        spread = np.diag(np.linalg.inv(u.T @ u.conj())).real
        np.testing.assert_allclose(found.standard_error[at], np.sqrt(np.outer(variance, spread)), rtol=1e-9)
        np.testing.assert_allclose(found.residual_power[at], variance * (end - begin), rtol=1e-9)
        np.testing.assert_allclose(found.coherence[at], 1 - left / np.sum(np.abs(y) ** 2, axis=0), rtol=1e-9)
        np.testing.assert_allclose(found.drive_power[at], u.T @ u.conj() / 2, rtol=1e-9)
        weights = np.sum(np.abs(u) ** 2, axis=1)
        freq = 1.6 * np.concatenate([np.arange(begin, end)] * 2)
        assert found.freq_hz[at] == pytest.approx(weights @ freq / weights.sum())
    assert found.excited_hz == pytest.approx((1.6 * marks[0], 1.6 * (marks[-1] - 1)))
    assert found.method == "band-averaged cross-spectrum"


def test_each_record_has_a_slope_of_its_own_in_each_output():
    """Outputs that are gains of the drives, and ramps on them."""
    gains, slopes = np.array([[2.0, -1.0], [0.5, 3.0], [1.0, 4.0]]), np.array([[0.1, -0.2, 0.3], [-0.4, 0.5, 0.6]])
    line = np.linspace(-1.0, 1.0, 500)[:, None]
    records = []
    for k, slope in enumerate(slopes):
        drive = drawn(500, 2, 3, k).drive
        records.append(recording(drive, drive @ gains.T + line * slope + 7.0, rate_hz=640.0))
    found = response_from_records(records, band_hz=(5.0, 300.0), bands=6)
    np.testing.assert_allclose(found.response, np.broadcast_to(gains, found.response.shape), atol=1e-9)
    spectra = response._transform(records, [r.output for r in records])
    edges = response._band_edges(spectra.freq_hz, 5.0, 300.0, 6, 8)
    np.testing.assert_allclose(response._unexplained_slopes(spectra, edges, 500), slopes, rtol=1e-9)


def test_bands_too_narrow_for_their_lines_are_joined_to_the_next():
    freq = 0.5 * np.arange(1001)
    marks = [20, 37, 68, 126, 234, 433, 800]
    assert np.round(np.geomspace(10.0, 400.0, 7) / 0.5).astype(int).tolist() == marks
    assert response._band_edges(freq, 10.0, 400.0, 6, 50) == [(20, 126), (126, 234), (234, 433), (433, 800)]
    assert response._band_edges(freq, 10.0, 400.0, 6, 17)[0] == (20, 37)
    assert response._band_edges(freq, 0.1, 900.0, 2, 17) == [(1, 19), (19, 1000)]  # never 0 nor half the rate
    assert told(response._band_edges, freq, 10.0, 400.0, 6, 781) == (
        "the record is too short for the band 10 to 400 Hz: it resolves 0.5 Hz, which leaves fewer than 781 lines; "
        "record longer."
    )


def test_the_drive_and_the_frequency_that_are_not_excited_are_named():
    auto = np.tile(np.diag([2.0, 3.0, 4.0]).astype(complex), (4, 1, 1))
    freq = np.array([10.0, 20.0, 30.5, 40.0])
    np.testing.assert_allclose(response._independent(auto, freq), np.tile(np.diag([1 / 2, 1 / 3, 1 / 4]), (4, 1, 1)))
    still = auto.copy()
    still[2, 1, 1] = still[3, 0, 0] = 0.0
    assert told(response._independent, still, freq) == (
        "input 1 is not excited at 30.5 Hz; narrow the band or excite it there."
    )
    alike = auto.copy()
    alike[1:] += 2.44948974 * np.array([[0, 1, 0], [1, 0, 0], [0, 0, 0]])
    alike[2] = np.diag([2.0, 3.0, 4.0]) + np.sqrt(6.0) * np.array([[0, 1, 0], [1, 0, 0], [0, 0, 0]])
    assert told(response._independent, alike, freq) == (
        "the 3 inputs are not driven independently at 30.5 Hz and most other frequencies, so their responses cannot be "
        "told apart; give at least 3 records with drives that differ (one input at a time, or orthogonal multisines)."
    )
    one = auto.copy()
    one[2] = alike[2]
    assert response._independent(one, freq).shape == (4, 3, 3)  # a single line that agrees is kept


def test_lines_are_excited_from_a_thousandth_of_the_strongest_drive_on():
    """Of the mean over realisations and periods, in the drive that has most of it; never 0, nor half the rate."""
    drive = np.zeros((2, 1, 9, 2), dtype=complex)
    drive[0, 0, 3, 0] = 10.0
    drive[:, 0, 5, 1] = np.sqrt(0.051)
    drive[:, 0, 6, 1] = np.sqrt(0.049)
    drive[:, 0, 4] = np.sqrt(0.03)
    drive[:, 0, [0, 8]] = 99.0
    assert response._excited_lines(drive, 16).tolist() == [3, 5]
    assert response._excited_lines(drive, 17).tolist() == [3, 8]
    assert told(response._excited_lines, 0 * drive, 16) == (
        "no drive changes in any record, so there is no response; excite the mirror."
    )


def test_periods_that_are_missing_or_too_few_are_told_in_full():
    records = [drawn(70, 1, 1, seed, period=16, name=name) for seed, name in ((1, "a"), (2, "b"), (3, "c"))]
    bare = replace(records[2], period_samples=None)
    assert told(response_from_periods, [*records[:2], bare]) == (
        "c: the record has no period; give period_samples or treat it as not periodic."
    )
    others = [replace(r, period_samples=n) for r, n in zip(records, (32, 8, 16), strict=True)]
    assert told(response_from_periods, others) == "the records have periods of [8, 16, 32] samples; they must agree."
    assert told(response_from_periods, records, skip_periods=4) == (
        "a: 70 samples hold 4 periods of 16, and 4 are to be dropped as transient; drop none or more and keep at least "
        "one, or record more periods."
    )
    unlike = [drawn(80, 1, 1, 1, period=16, name="a"), drawn(32, 1, 1, 2, period=16, name="b"), records[2]]
    assert told(response_from_periods, unlike, skip_periods=2).startswith("b: 32 samples hold 2 periods of 16, and 2 ")
    two = [drawn(40, 2, 1, seed, period=32) for seed in (1, 2)]
    assert told(response_from_periods, two) == (
        "2 records of one usable period for 2 inputs leave nothing to estimate the confidence from; give more "
        "realisations or more periods."
    )
    three = [drawn(64, 3, 1, seed, period=32) for seed in (1, 2)]
    assert told(response_from_periods, three) == (
        "2 records for 3 inputs: at least 3 realisations with different drives are needed."
    )


def test_a_band_of_periodic_records_has_its_lines_of_everything():
    records = [drawn(64, 2, 1, seed, period=16) for seed in (1, 2, 3)]
    whole, cut = (measure_frequency_response(records, band_hz=band) for band in (None, (80.0, 200.0)))
    assert cut.freq_hz.tolist() == [80.0, 120.0, 160.0, 200.0]
    for name in ("response", "standard_error", "noise_standard_error", "distortion_standard_error", "coherence"):
        np.testing.assert_array_equal(getattr(cut, name), getattr(whole, name)[1:5])
    for name in ("drive_power", "residual_power"):
        np.testing.assert_array_equal(getattr(cut, name), getattr(whole, name)[1:5])
    assert cut.drive_rms.shape == (2,) and cut.input_names == ("u0", "u1")
    assert told(measure_frequency_response, records, band_hz=(81.0, 119.5)) == (
        "no excited line lies between 81 and 119.5 Hz; widen the band."
    )
    assert told(measure_frequency_response, [*records, drawn(64, 2, 1, 4)]) == (
        "some recordings state their period and others do not; measure each kind by itself, or state it for all."
    )


@pytest.mark.parametrize(
    ("low", "high", "bands", "message"),
    [
        (100.0, 10.0, 9, "the band 100 to 10 Hz is empty; give a lower and a higher frequency."),
        (50.0, 50.0, 9, "the band 50 to 50 Hz is empty; give a lower and a higher frequency."),
        (0.0, 50.0, 9, "the band 0 to 50 Hz is empty; give a lower and a higher frequency."),
        (np.nan, 50.0, 9, "the band nan to 50 Hz is empty; give a lower and a higher frequency."),
        (
            10.0,
            12.5,
            1,
            "the record is too short for the band 10 to 12.5 Hz: it resolves 0.5 Hz, which leaves fewer than 8 lines; "
            "record longer.",
        ),
    ],
)
def test_a_band_that_holds_no_lines_is_told_in_full(low, high, bands, message):
    assert told(response._band_edges, 0.5 * np.arange(401), low, high, bands, 8) == message


@pytest.mark.parametrize(
    ("low", "high", "bands", "edges"),
    [
        (10.0, 14.0, 1, "20-28"),
        (10.0, 40.0, 2, "20-40 40-80"),
        (10.0, 40.0, 4, "20-28 28-40 40-57 57-80"),
        (1.0, 16.0, 4, "2-16 16-32"),
        (100.0, 900.0, 2, "200-400"),
        (0.1, 8.0, 3, "1-16"),
    ],
)
def test_bands_are_logarithmic_within_the_lines_that_there_are(low, high, bands, edges):
    found = response._band_edges(0.5 * np.arange(401), low, high, bands, 8)
    assert " ".join(f"{begin}-{end}" for begin, end in found) == edges


@pytest.mark.parametrize(
    ("records", "words", "message"),
    [
        (lambda: [], {}, "no recording was given; name at least one."),
        (
            lambda: [drawn(n, 1, 1, n, name=str(n)) for n in (300, 40, 300)],
            {},
            "the records have [40, 300] samples; cut them to one length.",
        ),
        (
            lambda: [drawn(300, k, 1, k, name=f"r{k}") for k in (2, 1)],
            {},
            "r1: 1 input and 1 output, where r2 has 2 and 1; choose the same channels in each record.",
        ),
        (
            lambda: [replace(drawn(300, 1, 1, 1), drive=np.full((300, 1), 3.0))],
            {},
            "no drive changes in any record, so there is no response; excite the mirror.",
        ),
    ],
)
def test_records_without_a_period_that_give_no_response_are_told_in_full(records, words, message):
    assert told(response_from_records, records(), **words) == message
    assert told(measure_frequency_response, records(), **words) == message


@pytest.mark.parametrize(("noise", "spare"), [(None, True), (4.0, False), (4.0, True), (36.0, True)])
def test_standard_errors_are_split_where_there_is_something_to_split(noise, spare):
    """Variances of two outputs at one line, spread over three drives; noise beyond the whole leaves no distortion."""
    total, spread = np.array([[9.0, 25.0]]), np.array([[[1.0, 4.0, 0.25]]])
    given = None if noise is None else np.full((1, 2), noise)
    errors, noisy, distortion = response._standard_errors(total, given, spread, spare)
    np.testing.assert_allclose(errors, [[[3.0, 6.0, 1.5], [5.0, 10.0, 2.5]]])
    assert (noisy is None, distortion is None) == (noise is None, noise is None or not spare)
    if noise:
        np.testing.assert_allclose(noisy, np.sqrt(noise) * np.array([[[1.0, 2.0, 0.5]] * 2]))
    if distortion is not None:
        left = np.sqrt(np.maximum(np.array([9.0, 25.0]) - noise, 0.0))
        np.testing.assert_allclose(distortion, left[None, :, None] * [1.0, 2.0, 0.5], atol=1e-12)


@pytest.mark.parametrize(
    ("band_hz", "bands", "message"),
    [
        (
            (600.0, 900.0),
            6,
            "the band 600 to 900 Hz begins at or above half the sample rate, up to which a record shows something: "
            "200 Hz; give a lower band.",
        ),
        ((5.0, 100.0), 0, "the number of bands is 0; give a whole number above 0."),
        ((5.0, 100.0), -1, "the number of bands is -1; give a whole number above 0."),
        ((5.0, 100.0), 2.5, "the number of bands is 2.5; give a whole number above 0."),
    ],
)
def test_a_band_that_no_longer_record_has_is_refused_as_such(band_hz, bands, message):
    assert told(response._band_edges, 0.5 * np.arange(401), *band_hz, bands, 8) == message


def test_rates_that_hardly_differ_are_told_apart():
    first, second = drawn(40, 1, 1, 1, name="a"), drawn(40, 1, 1, 2, name="b")
    second = replace(second, rate_hz=first.rate_hz * (1 + 4e-7))
    words = told(response.check_alike, [first, second], "used")
    assert f"is {second.rate_hz:.17g} Hz and that of a {first.rate_hz:.17g} Hz" in words


@pytest.mark.parametrize(
    ("low", "high"), [(10.0, np.nan), (10.0, np.inf), (-5.0, 50.0), (10.0, 0.0), (10.0, -50.0), (-np.inf, 50.0)]
)
def test_a_band_has_two_ends_above_nothing(low, high):
    assert told(response._band_edges, 0.5 * np.arange(401), low, high, 9, 8) == (
        f"the band {low:g} to {high:g} Hz is empty; give a lower and a higher frequency."
    )
