"""Capacity of pulse positions against sums over all counts, simulated words, and what is published."""

import itertools
import math

import numpy as np
import pytest
from scipy import stats

from microrad.core.capacity import Code
from microrad.core.pulse_capacity import least_pulse_counts, noiseless_bits, soft_bits
from microrad.link import receivers


def summed(order, pulse, background):
    """Mutual information in bits by the sum over the counts of every slot, the pulse in the first."""
    k = np.arange(0.0, math.ceil(pulse + background + 9.0 * math.sqrt(pulse + background) + 14.0))
    empty, lit = stats.poisson.pmf(k, background), stats.poisson.pmf(k, pulse + background)
    log_ratio = k * math.log1p(pulse / background)
    told = 0.0
    for others in itertools.product(range(k.size), repeat=order - 1):
        weight = math.prod(empty[each] for each in others)
        if weight > 1e-19:
            total = np.logaddexp(log_ratio, np.logaddexp.reduce([log_ratio[each] for each in others]))
            told += weight * float(lit @ (total - log_ratio))
    return math.log2(order) - told / math.log(2.0)


@pytest.mark.promise("link-91")
@pytest.mark.parametrize(
    ("order", "pulse", "background"),
    [(2, 2.0, 0.5), (2, 0.1, 1.0), (2, 6.0, 20.0), (4, 1.0, 0.01), (4, 2.0, 0.5), (4, 0.02, 0.3)],
)
def test_the_integral_is_the_sum_over_all_counts(order, pulse, background):
    # both take away terms of size log2 M: 1e-12 of it is their rounding and the tails that are cut
    assert soft_bits(order, pulse, background) == pytest.approx(summed(order, pulse, background), rel=0.0, abs=1e-11)


@pytest.mark.promise("link-91")
@pytest.mark.parametrize(("order", "pulse", "background"), [(64, 3.0, 0.2), (16, 40.0, 100.0), (256, 2.0, 1e-3)])
def test_capacity_is_what_simulated_words_tell(order, pulse, background):
    random = np.random.Generator(np.random.Philox(key=order))
    told = []
    for _ in range(2):
        counts = random.poisson(background, (10_000, order)).astype(float)
        counts[:, 0] += random.poisson(pulse, 10_000)
        above = (counts - counts[:, :1]) * math.log1p(pulse / background)
        told.append(math.log2(order) - np.logaddexp.reduce(above, axis=1) / math.log(2.0))
    told = np.concatenate(told)
    assert abs(soft_bits(order, pulse, background) - told.mean()) < 4.0 * told.std() / math.sqrt(told.size)


@pytest.mark.promise("link-91")
@pytest.mark.parametrize("order", [2, 16, 1024])
def test_without_background_it_is_the_erasure_channel(order):
    expected = -math.expm1(-1.5) * math.log2(order)
    assert noiseless_bits(order, 1.5) == pytest.approx(expected, rel=1e-14)
    assert soft_bits(order, 1.5, 0.0) == pytest.approx(expected, rel=1e-14)
    little = soft_bits(order, 1.5, 1e-13)
    assert little < expected
    assert little == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("background", [0.0, 0.5])
def test_no_pulse_tells_nothing(background):
    assert soft_bits(16, 0.0, background) == 0.0


@pytest.mark.promise("link-91")
@pytest.mark.parametrize(
    ("order", "rate", "bits_per_photon"), [(16, 0.5, 2.885), (64, 1 / 3, 4.933), (128, 0.5, 5.049)]
)
def test_bits_per_photon_without_background_are_those_published(order, rate, bits_per_photon):
    assert rate * math.log2(order) / least_pulse_counts(order, rate, 0.0) == pytest.approx(bits_per_photon, abs=5e-4)


@pytest.mark.promise("link-91")
@pytest.mark.parametrize("background", [1e-12, 1e-3, 0.3, 30.0, 1e4])
@pytest.mark.parametrize("order", [2, 64])
def test_the_least_pulse_has_the_capacity_and_grows_with_background(order, background):
    least = least_pulse_counts(order, 0.4, background)
    assert soft_bits(order, least, background) == pytest.approx(0.4 * math.log2(order), rel=1e-9)
    assert least_pulse_counts(order, 0.4, 0.5 * background) < least


def test_in_much_background_it_is_the_capacity_of_gaussian_slots():
    # counts of mean b: the same as M orthogonal signals with the signal over noise n^2 / b
    random = np.random.Generator(np.random.Philox(key=9))
    snr, order = 6.0, 4
    noise = random.standard_normal((400_000, order))
    noise[:, 0] += math.sqrt(snr)
    above = math.sqrt(snr) * (noise - noise[:, :1])
    told = math.log2(order) - np.logaddexp.reduce(above, axis=1) / math.log(2.0)
    found = soft_bits(order, math.sqrt(snr * 1e6), 1e6)
    assert abs(found - told.mean()) < 4.0 * told.std() / math.sqrt(told.size) + 5e-3  # the pulse's own noise


@pytest.mark.promise("link-25")
@pytest.mark.parametrize("background", [0.01, 1.0, 30.0])
@pytest.mark.parametrize("code", [(0.5, 1e-6), (0.9, 1e-3)])
def test_no_gain_in_background_passes_the_bound_which_is_near(code, background):
    order, rate = 16, 1e6
    counter = receivers.PpmCounting(
        wavelength_m=1.55e-6,
        bandwidth_hz=1e15,
        bit_error_ratio=code[1],
        order=order,
        detection_efficiency=1.0,
        dark_count_rate_hz=background * rate,
        code_rate=code[0],
        code_gap_db=0.0,
    )
    gain, bound = 10.0 ** (float(counter.net_gain_db(rate)) / 10.0), Code(*code).ppm_counting(order, background)
    assert 10.0**-0.13 * bound < gain <= bound * (1.0 + 1e-9)
    assert bound <= Code(*code).ppm_counting()


@pytest.mark.parametrize(
    ("order", "pulse", "background", "bits"),
    [
        (2, 3.0, 0.7, 0.770915347), (3, 0.2, 5.0, 0.00377524823), (64, 9.0, 0.02, 5.99756678), (4, 300.0, 2.0, 2.0),
        (256, 40.0, 25.0, 7.99494499), (16, 1e-3, 1.0, 6.76023889e-07), (7, 2.5, 1e-17, 2.57691375),
    ],
)  # fmt: skip
def test_what_a_pulse_tells_of_its_slot_in_orders_and_backgrounds_unlike_each_other(order, pulse, background, bits):
    assert soft_bits(order, pulse, background) == pytest.approx(bits, rel=1e-6)
    if order < 4:
        assert summed(order, pulse, background) == pytest.approx(bits, rel=1e-6)


@pytest.mark.parametrize(
    ("order", "share", "background", "counts"),
    [
        (2, 0.5, 0.7, 1.74572161), (3, 0.9, 5.0, 8.35474361), (64, 0.33, 0.02, 0.683510697), (5, 0.75, 0.0, 1.38629436),
        (256, 0.99, 25.0, 31.7023617), (16, 0.05, 1.0, 0.599025205), (9, 0.75, 1e-16, 1.38629436),
    ],
)  # fmt: skip
def test_the_least_pulse_of_a_share_in_orders_and_backgrounds_unlike_each_other(order, share, background, counts):
    assert least_pulse_counts(order, share, background) == pytest.approx(counts, rel=1e-6)


@pytest.mark.parametrize(
    ("rate", "ratio", "order", "background", "asks"),
    [(0.5, 0.1, 4, 40.0, True), (0.3, 0.2, 2, 40.0, True), (0.5, 0.2, 16, 5.0, False)],
)
def test_the_gain_in_background_is_the_bound_without_a_code_over_the_least_pulse(rate, ratio, order, background, asks):
    """Both for each bit of the line; the error ratio is large, so that the order and it tell the terms of the bound."""
    slot = background * math.log2(order) / order
    union = math.log(order / ratio / 2.0)
    said = rate * (1.0 + ratio * math.log2(ratio) + (1.0 - ratio) * math.log2(1.0 - ratio))
    low, high = 1e-3, 1e4
    for _ in range(80):
        middle = math.sqrt(low * high)
        told = soft_bits(order, middle, slot * rate) < said * math.log2(order)
        low, high = (middle, high) if told else (low, middle)
    expected = rate * (union + 2.0 * math.sqrt(slot * union)) / low
    dark = rate * math.log(0.5 / ratio) / -math.log(1.0 - said)
    assert Code(rate, ratio).ppm_counting(order, background) == pytest.approx(min(dark, expected), rel=1e-6)
    assert Code(rate, ratio).ppm_counting(order) == pytest.approx(dark, rel=1e-9)
    assert (expected < dark) is asks
