"""Held against capacities that are summed and integrated here, and the receivers' own powers without a code."""

import itertools
import math

import numpy as np
import pytest
from scipy import integrate, optimize, stats

from link_files import RECEIVERS, link_file, received_with
from microrad import link
from microrad.core.capacity import Code, _OnOff, excess_noise_factor, untold_of_a_sign
from microrad.core.capacity import entropy as binary_entropy
from microrad.link import receivers
from microrad.mission.toml import MissionError

RATE = 1e6
COMMON = {"wavelength_m": 1.55e-6, "bandwidth_hz": 1e15, "detection_efficiency": 1.0}
CODES = [(0.9, 1e-3), (0.5, 1e-6), (0.1, 1e-9), (1.0, 1e-6)]


def entropy(share):
    return float(stats.entropy([share, 1.0 - share], base=2))


def least(told, code):
    """Signal at which a capacity, rising in it, lets through what the code and its errors leave to say."""
    rate, ratio = code
    wanted = rate * (1.0 - entropy(ratio))
    return math.exp(optimize.brentq(lambda x: told(math.exp(x)) - wanted, -9.0, 7.0, xtol=1e-10))


def told_on_off(signal, mark, space, background):
    """Bits in the Poisson counts of a mark or a space."""
    counts = np.arange(0.0, mark * signal + background + 12.0 * math.sqrt(mark * signal + background) + 60.0)
    laws = stats.poisson.pmf(counts, np.array([[mark], [space]]) * signal + background)
    return entropies(laws.mean(axis=0)) - np.mean([entropies(law) for law in laws])


def entropies(law):
    return float(stats.entropy(law, base=2) * law.sum())


def told_ppm(pulse, order):
    """Bits in a word: each of its inputs, all slots empty or the pulse in its own."""
    seen = np.hstack([np.eye(order) * -np.expm1(-pulse), np.full((order, 1), math.exp(-pulse))])
    return (entropies(seen.mean(axis=0)) - entropies(seen[0])) / math.log2(order)


def told_ppm_background(pulse, background):
    """Bits in a word of two slots, both with background."""
    counts = np.arange(0.0, pulse + background + 12.0 * math.sqrt(pulse + background) + 60.0)
    first = np.outer(stats.poisson.pmf(counts, pulse + background), stats.poisson.pmf(counts, background))
    return entropies((first + first.T).ravel() / 2.0) - entropies(first.ravel())


def told_two_signs(snr):
    """Bits in the sign of a real symbol in Gaussian noise."""
    root = math.sqrt(snr)
    lost = integrate.quad(
        lambda y: stats.norm.pdf(y - root) * np.logaddexp(0.0, -2.0 * y * root) / math.log(2.0), root - 12, root + 12
    )[0]
    return 1.0 - lost


@pytest.mark.promise("link-25")
@pytest.mark.parametrize("code", CODES)
@pytest.mark.parametrize("order", [2, 16])
def test_ppm_gains_what_its_erasures_leave(order, code):
    uncoded = receivers.PpmCounting(**COMMON, bit_error_ratio=code[1], order=order).photons_per_bit(RATE)
    coded = least(lambda n: told_ppm(n, order), code) / (code[0] * math.log2(order))
    assert Code(*code).ppm_counting() == pytest.approx(float(uncoded) / coded, rel=1e-6)


@pytest.mark.promise("link-25")
@pytest.mark.parametrize("code", CODES)
def test_on_off_keying_with_dark_spaces_gains_what_its_misses_leave(code):
    uncoded = receivers.OokCounting(**COMMON, bit_error_ratio=code[1]).photons_per_bit(RATE)
    coded = least(lambda n: told_on_off(n, 2.0, 0.0, 0.0), code) / code[0]
    assert Code(*code).ook_counting(2.0, 0.0, 0.0) == pytest.approx(float(uncoded) / coded, rel=1e-6)


@pytest.mark.promise("link-25")
@pytest.mark.parametrize("code", CODES[:3])
@pytest.mark.parametrize("background", [0.0, 0.01, 1.0, 30.0])
@pytest.mark.parametrize("extinction", [1e6, 20.0, 3.0])
def test_no_counter_gains_more_in_background_and_bright_spaces(extinction, background, code):
    counter = receivers.OokCounting(
        **COMMON, bit_error_ratio=code[1], extinction_ratio=extinction, dark_count_rate_hz=background * RATE
    )
    space = 2.0 / (extinction + 1.0)
    coded = least(lambda n: told_on_off(n, 2.0 - space, space, code[0] * background), code) / code[0]
    gain = float(counter.photons_per_bit(RATE)) / coded
    bound = Code(*code).ook_counting(2.0 - space, space, background)
    assert 10.0**-0.25 * bound < gain < bound <= Code(*code).ook_counting(2.0 - space, space)


@pytest.mark.promise("link-25")
@pytest.mark.parametrize("code", CODES[:3])
@pytest.mark.parametrize("background", [0.01, 1.0])
def test_ppm_gains_less_in_background(background, code):
    counter = receivers.PpmCounting(
        **COMMON, bit_error_ratio=code[1], order=2, dark_count_rate_hz=2.0 * background * RATE
    )
    coded = least(lambda n: told_ppm_background(n, code[0] * background), code) / code[0]
    assert float(counter.photons_per_bit(RATE)) / coded < Code(*code).ppm_counting()


@pytest.mark.promise("link-25")
@pytest.mark.parametrize("code", CODES)
def test_phases_gain_what_the_signs_of_their_quadratures_tell(code):
    snr = least(told_two_signs, code) / code[0]
    assert Code(*code).phases() == pytest.approx(stats.norm.isf(code[1]) ** 2 / snr, rel=1e-6)


@pytest.mark.promise("link-25")
@pytest.mark.parametrize("snr", [1e-3, 1.0, 20.0, 80.0])
def test_what_a_sign_leaves_untold_keeps_its_digits(snr):
    root = math.sqrt(snr)
    pieces = [root + each for each in (-20.0, -10.0, -root - 1.0, -root, -root + 1.0, -0.5 * root, 0.0, 10.0, 20.0)]
    lost = sum(
        integrate.quad(
            lambda y: stats.norm.pdf(y - root) * np.logaddexp(0.0, -2.0 * y * root), *ends, epsabs=0.0, epsrel=1e-11
        )[0]
        for ends in itertools.pairwise(sorted(pieces))
    )
    assert untold_of_a_sign(snr) == pytest.approx(lost / math.log(2.0), rel=1e-9, abs=0.0)


@pytest.mark.promise("link-25")
@pytest.mark.parametrize("code", [(0.5, 1e-6), (0.1, 1e-9)])
def test_phase_differences_gain_less_than_shannons_bound_and_come_near_it_at_low_rates(code):
    snr, bound = least(told_two_signs, code) / code[0], Code(*code).dpsk_preamplified()
    assert 0.9 * bound < 2.0 * math.log(0.5 / code[1]) / snr < bound


@pytest.mark.promise("link-25")
@pytest.mark.parametrize("name", RECEIVERS)
def test_a_mission_takes_the_gain_that_a_code_can_have_and_no_more(tmp_path, name):
    table = link_file(tmp_path, received_with(name)).mission.communication
    limit = 10.0 * math.log10(table.receiver.most_code_gain(table.data_rate_bit_s, table.wavelength_m))
    below = math.floor(limit * 100.0) / 100.0
    taken = link_file(tmp_path, received_with(name, code_gain=f"{below:.2f} dB")).mission
    assert np.isfinite(link.of(taken).receiver.required_power_w(1e8))
    with pytest.raises(MissionError) as refused:
        link_file(tmp_path, received_with(name, code_gain=f"{below + 0.01:.2f} dB"))
    (fault,) = refused.value.faults
    assert "communication.receiver.code_gain" in str(fault)
    assert f"is more than any code can gain: {limit:.3g} dB at code_rate = 0.8 and bit_error_ratio = 1e-06" in str(
        fault
    )
    assert f'at most "{below:.2f} dB" at code_rate = 0.8' in str(fault)


@pytest.mark.parametrize("name", RECEIVERS)
def test_a_link_without_a_code_is_never_refused(tmp_path, name):
    for ratio in (1e-18, 0.499):
        right = {"phase_error": None} if "phase_error" in RECEIVERS[name] else {}
        plain = received_with(name, code_gain="0 dB", code_rate=1.0, bit_error_ratio=ratio, **right)
        assert link_file(tmp_path, plain).mission.communication.receiver.code_gain_db == 0.0


def test_the_background_that_is_not_known_yet_is_any(tmp_path):
    def most(**others):
        c = link_file(tmp_path, received_with("counting ook", **others) | rate).mission.communication
        return c.receiver.most_code_gain(c.data_rate_bit_s, c.wavelength_m)

    rate = {"communication.data_rate": "300 Mbit/s"}
    known = most()
    sky = {"spectral_radiance": "10 W/(m^2 sr um)", "field_of_view": "100 urad", "filter_bandwidth": "1 nm"}
    assert most(background_power=None, background=sky) > known
    rate = {"communication.data_rate": "largest"}
    assert most() > known


@pytest.mark.promise("link-25")
def test_the_gain_against_shot_noise_is_in_proportion_to_its_excess():
    one, two, five = (Code(0.5, 1e-9).ook_current(2.0, 0.0, excess) for excess in (1.0, 2.0, 5.0))
    assert two > one
    assert five - one == pytest.approx(4.0 * (two - one), rel=1e-9)


@pytest.mark.parametrize(("share", "bits"), [(0.0, 0.0), (1.0, 0.0), (0.5, 1.0), (0.11, 0.499916), (0.89, 0.499916)])
def test_a_share_of_none_or_all_holds_no_bit_and_one_of_a_half_a_whole_one(share, bits):
    assert binary_entropy(share) == pytest.approx(bits, abs=1e-6)


def test_counts_that_no_signal_tells_apart_have_no_exponent():
    """Where the background swallows the signal, too, down to the last digit."""
    line = _OnOff(2.0, 0.0)
    assert line.exponent(0.0, 3.0) == 0.0
    assert line.exponent(1e-20, 3.0) == 0.0
    assert line.exponent(1.5, 0.0) == 3.0
    assert 0.0 < line.exponent(1.5, 3.0) < 3.0


GAINS = """ppm_counting           | 6.52305274 5.19360058 20.0291178 2.81217651
ppm_counting 16 0.3    | 6.36312968 5.19360058 16.1436176 2.81217651
ppm_counting 8 0.0     | 6.52305274 5.19360058 20.0291178 2.81217651
ook_counting 1.9 0.1   | 9.9271828 7.60237303 28.8960184 4.10628372
ook_counting 1.9 .1 .4 | 7.7265519 5.64580006 19.6395146 2.83767312
ook_current 1.8 0.2    | 11.5297064 8.18849787 31.0422248 2.81434878
ook_current 1.8 .2 3.5 | 32.8963909 22.7910141 95.9130574 6.78223345
ook_preamplified       | 7.43227414 5.10284921 18.0677585 1.98019858
phases                 | 7.06330693 5.44638587 25.9477335 1.49498576
dpsk_preamplified      | 10.3358185 7.1724824 28.8953508 3.89634148"""


@pytest.mark.parametrize("line", GAINS.splitlines())
def test_the_largest_gains_of_codes_unlike_each_other(line):
    called, gains = line.split("|")
    name, *given = called.split()
    given = [int(each) if each.isdigit() else float(each) for each in given]
    codes = Code(0.8, 1e-6), Code(0.33, 1e-3), Code(1e-5, 1e-9), Code(1.0, 0.2)
    assert [getattr(code, name)(*given) for code in codes] == pytest.approx([*map(float, gains.split())], rel=1e-6)


@pytest.mark.parametrize(("gain", "ratio", "factor"), [(1, 0.3, 1), (10, 0, 1.9), (10, 0.2, 3.52), (40, 1, 40)])
def test_excess_noise_is_mcintyres(gain, ratio, factor):
    assert excess_noise_factor(gain, ratio) == pytest.approx(factor, rel=1e-12)
