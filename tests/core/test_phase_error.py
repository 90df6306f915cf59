"""Error ratios under a phase error against an own quadrature, simulated samples and their floor."""

import math
from itertools import pairwise

import numpy as np
import pytest
from scipy import integrate, stats

from microrad.core import phase_error


def averaged(amplitude, rms, quadratures):
    """The mean over the phase, piece by piece around each change of sign."""

    def seen(phase):
        return math.cos(phase) - (math.sin(phase) if quadratures == 2 else 0.0)

    def density(x):
        return math.exp(-((x / rms) ** 2) / 2.0) / (math.sqrt(2.0 * math.pi) * rms)

    first, near = math.pi / (2 * quadratures), (1.0, 3.0, 10.0, 30.0)
    signs = [first + k * math.pi for k in range(-8, 9)]
    edges = {k * rms / 2.0 for k in range(-30, 31)} | set(signs)
    edges |= {at + side * far / amplitude for at in signs for side in (-1.0, 1.0) for far in near}
    pieces = pairwise(sorted(edge for edge in edges if abs(edge) <= 15.0 * rms))
    return math.fsum(
        integrate.quad(
            lambda x: density(x) * math.erfc(amplitude * seen(x) / math.sqrt(2.0)) / 2.0,
            *ends,
            epsabs=0.0,
            epsrel=1e-11,
        )[0]
        for ends in pieces
    )


@pytest.mark.promise("link-92")
@pytest.mark.parametrize(
    ("amplitude", "rms", "quadratures"),
    [(6.0, 0.1, 1), (6.0, 0.2, 1), (8.5, 0.08, 2), (3.0, 0.7, 1), (50.0, 0.3, 2), (1e4, 0.3, 2), (20.0, 0.2, 1)],
)
def test_the_mean_ratio_is_that_of_an_own_quadrature(amplitude, rms, quadratures):
    found = float(phase_error.bit_error_ratio(np.asarray(amplitude), rms, quadratures))
    assert found == pytest.approx(averaged(amplitude, rms, quadratures), rel=1e-9, abs=0.0)


@pytest.mark.promise("link-92")
@pytest.mark.parametrize(("quadratures", "rms"), [(1, 0.5), (2, 0.25), (2, 0.9)])
def test_the_mean_ratio_is_that_of_simulated_complex_samples(quadratures, rms):
    random = np.random.Generator(np.random.Philox(key=quadratures))
    samples, amplitude = 400_000, 2.2
    bits = random.choice([-1.0, 1.0], (quadratures, samples))
    sent = bits[0] + (1j * bits[1] if quadratures == 2 else 0.0)
    noise = random.standard_normal(samples) + 1j * random.standard_normal(samples)
    seen = amplitude * sent * np.exp(1j * rms * random.standard_normal(samples)) + noise
    wrong = np.sign(seen.real) != bits[0]
    if quadratures == 2:
        wrong = np.concatenate([wrong, np.sign(seen.imag) != bits[1]])
    found = float(phase_error.bit_error_ratio(np.asarray(amplitude), rms, quadratures))
    # the two bits of a symbol share their phase: no more than twice the variance of independent ones
    assert abs(found - wrong.mean()) < 4.0 * math.sqrt(2.0 * found / wrong.size)


@pytest.mark.promise("link-92")
@pytest.mark.parametrize(("quadratures", "rms"), [(1, 0.4), (2, 0.2), (2, 0.6), (1, 1.0)])
def test_more_signal_ends_at_the_floor(quadratures, rms):
    floor = phase_error.floor(rms, quadratures)
    strong, stronger = phase_error.bit_error_ratio(np.array([1e3, 1e6]), rms, quadratures)
    assert floor < stronger < strong
    assert stronger == pytest.approx(floor, rel=1e-5)
    phases = np.linspace(-13.0 * rms, 13.0 * rms, 2_000_001)
    seen = np.cos(phases) - (np.sin(phases) if quadratures == 2 else 0.0)
    share = integrate.trapezoid(np.where(seen < 0.0, stats.norm.pdf(phases, scale=rms), 0.0), phases)
    assert floor == pytest.approx(share, rel=1e-3)


@pytest.mark.promise("link-92")
@pytest.mark.parametrize("quadratures", [1, 2])
@pytest.mark.parametrize("ratio", [1e-3, 1e-9, 1e-15])
def test_no_power_reaches_a_ratio_below_the_floor(quadratures, ratio):
    most = phase_error.largest_rms_rad(ratio, quadratures)
    assert math.isinf(phase_error.amplitude_for(ratio, most * 1.001, quadratures))
    reached = phase_error.amplitude_for(ratio, most * 0.97, quadratures)
    again = float(phase_error.bit_error_ratio(np.asarray(reached), most * 0.97, quadratures))
    assert again == pytest.approx(ratio, rel=1e-9, abs=0.0)
    clean = phase_error.amplitude_for(ratio, 0.0, quadratures)
    assert clean == pytest.approx(stats.norm.isf(ratio), rel=1e-12)
    assert reached > clean


@pytest.mark.parametrize("quadratures", [1, 2])
@pytest.mark.parametrize("ratio", [1e-3, 1e-9, 1e-15])
@pytest.mark.parametrize("rms_rad", [1e-12, 1e-9, 1e-7, 1e-5])
def test_a_phase_error_that_nobody_could_see_needs_as_much_as_none(rms_rad, ratio, quadratures):
    clean = phase_error.amplitude_for(ratio, 0.0, quadratures)
    # to second order the loss is that of the mean of the cosine and of what the sine adds: some amplitude^2 rms^2
    assert phase_error.amplitude_for(ratio, rms_rad, quadratures) == pytest.approx(
        clean, rel=clean**2 * rms_rad**2 + 1e-11
    )


@pytest.mark.parametrize(("quadratures", "rms_rad"), [(1, 0.5), (2, 0.3)])
def test_a_ratio_at_the_floor_is_reached_by_no_power(quadratures, rms_rad):
    floor = phase_error.floor(rms_rad, quadratures)
    assert math.isinf(phase_error.amplitude_for(floor, rms_rad, quadratures))
    assert math.isfinite(phase_error.amplitude_for(1.001 * floor, rms_rad, quadratures))
    assert phase_error.floor(0.0, quadratures) == 0.0


@pytest.mark.parametrize("quadratures", [1, 2])
def test_ratios_have_the_shape_of_the_amplitudes(quadratures):
    for rms_rad in (0.0, 0.1):
        for amplitude in (np.zeros((0,)), np.ones((2, 3)), np.ones(300), np.asarray(2.0)):
            assert phase_error.bit_error_ratio(amplitude, rms_rad, quadratures).shape == amplitude.shape
    assert phase_error.bit_error_ratio(np.zeros(1), 0.1, quadratures) == pytest.approx([0.5], rel=1e-9)


@pytest.mark.parametrize(
    ("ratio", "rms_rad", "two", "four"),
    [
        (1e-3, 0.2, 3.16813588, 4.61622137), (1e-9, 0.05, 6.00566752, 6.32422092), (0.1, 0.5, 1.49260844, 2.12431917),
        (0.3, 0.9, 0.8147916, 0.901145238), (1e-15, 0.01, 7.94174366, 7.96706256),
        (0.45, 1.0, 0.207758282, 0.208876548),
    ],
)  # fmt: skip
def test_an_amplitude_of_two_and_of_four_phases_gives_the_ratio_by_a_quadrature_of_its_own(ratio, rms_rad, two, four):
    found = [phase_error.amplitude_for(ratio, rms_rad, quadratures) for quadratures in (1, 2)]
    assert found == pytest.approx([two, four], rel=1e-6)
    for quadratures, amplitude in enumerate(found, 1):
        assert averaged(amplitude, rms_rad, quadratures) == pytest.approx(ratio, rel=1e-6)


@pytest.mark.parametrize(
    ("rms_rad", "two", "four"),
    [
        (0.15, 1.16192477e-25, 8.20524160e-08), (0.35, 7.18984698e-06, 0.0124163695), (1.0, 0.116227517, 0.225298676),
        (0.62, 0.0112916059, 0.102690807),
    ],
)  # fmt: skip
def test_a_floor_is_the_share_of_the_time_beyond_a_quarter_or_an_eighth_of_a_turn(rms_rad, two, four):
    assert phase_error.floor(rms_rad, 1) == pytest.approx(two, rel=1e-6)
    assert phase_error.floor(rms_rad, 2) == pytest.approx(four, rel=1e-6)


@pytest.mark.parametrize(
    ("ratio", "two", "four"),
    [
        (1e-12, 0.22029238, 0.111649722), (2e-6, 0.330455736, 0.170317294), (0.03, 0.723839128, 0.417588676),
        (0.2, 1.0, 0.913834208), (0.45, 1.0, 1.0),
    ],
)  # fmt: skip
def test_the_largest_phase_error_of_a_ratio_is_no_larger_than_one_that_is_locked(ratio, two, four):
    assert phase_error.largest_rms_rad(ratio, 1) == pytest.approx(two, rel=1e-6)
    assert phase_error.largest_rms_rad(ratio, 2) == pytest.approx(four, rel=1e-6)


def test_where_more_than_the_largest_power_is_needed_there_is_none():
    """Just above the ratio that is left at any power, the amplitude grows without end."""
    rms = 0.3
    least = phase_error.floor(rms, 1)
    assert math.isfinite(phase_error.amplitude_for(least * 1.5, rms, 1))
    assert phase_error.amplitude_for(least, rms, 1) == math.inf
    assert phase_error.amplitude_for(math.nextafter(least, 1.0), rms, 1) == math.inf
