import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy import integrate, optimize, stats
from scipy.special import gammainc, gammaincc

from microrad.core.units import ELEMENTARY_CHARGE_C, PLANCK_J_S, SPEED_OF_LIGHT_M_S
from microrad.link.gains import photon_energy_j
from microrad.link.receivers import (
    BpskHeterodyne,
    BpskHomodyne,
    DpskPreamplified,
    OokApd,
    OokCounting,
    OokPin,
    OokPreamplified,
    PpmCounting,
    QpskHeterodyne,
    QpskHomodyne,
    RateError,
    Receiver,
    apd_excess_noise_factor,
    background_photons_per_mode,
    background_power_w,
    counting,
)

WAVELENGTH_M = 1.55e-6
COMMON = {"wavelength_m": WAVELENGTH_M, "bit_error_ratio": 1e-9, "bandwidth_hz": 1e11}
PHOTON_J = photon_energy_j(WAVELENGTH_M)

COUNTER = OokCounting(**COMMON, detection_efficiency=1.0)
NOISY_COUNTER = OokCounting(
    **COMMON, detection_efficiency=0.4, dark_count_rate_hz=2e5, background_power_w=5e-13, extinction_ratio=15.0
)
PIN = OokPin(
    **COMMON,
    quantum_efficiency=0.8,
    thermal_noise_a_sqrt_hz=3e-12,
    dark_current_a=5e-9,
    background_power_w=2e-8,
    extinction_ratio=10.0,
)
APD = OokApd(
    **COMMON,
    quantum_efficiency=0.7,
    thermal_noise_a_sqrt_hz=3e-12,
    dark_current_a=2e-9,
    background_power_w=1e-9,
    extinction_ratio=20.0,
    gain=12.0,
    ionisation_ratio=0.4,
)
PREAMPLIFIED = OokPreamplified(
    **COMMON,
    noise_figure_db=4.0,
    gain_db=35.0,
    optical_bandwidth_hz=5e10,
    extinction_ratio=12.0,
)
DPSK = DpskPreamplified(**COMMON, noise_figure_db=3.0)
NOISY_DPSK = replace(DPSK, noise_figure_db=4.5, background_photons_per_mode=0.2)
BPSK = BpskHomodyne(**COMMON, quantum_efficiency=1.0)
NOISY_BPSK = replace(BPSK, quantum_efficiency=0.7, background_photons_per_mode=0.3)
BPSK_BESIDE = BpskHeterodyne(**COMMON, quantum_efficiency=1.0)
QPSK = QpskHomodyne(**COMMON, quantum_efficiency=1.0)
QPSK_BESIDE = QpskHeterodyne(**COMMON, quantum_efficiency=1.0)
NOISY_PHASES = {"quantum_efficiency": 0.7, "background_photons_per_mode": 0.3}
PPM = PpmCounting(**COMMON, detection_efficiency=1.0, order=16)
NOISY_PPM = replace(PPM, detection_efficiency=0.5, dark_count_rate_hz=1e5, background_power_w=1e-11)

ALL = {
    "counter": COUNTER,
    "noisy counter": NOISY_COUNTER,
    "pin": PIN,
    "apd": APD,
    "preamplified": PREAMPLIFIED,
    "dpsk": DPSK,
    "noisy dpsk": NOISY_DPSK,
    "bpsk": BPSK,
    "noisy bpsk": NOISY_BPSK,
    "noisy heterodyne bpsk": replace(BPSK_BESIDE, **NOISY_PHASES, phase_error_rad=0.1),
    "noisy homodyne qpsk": replace(QPSK, **NOISY_PHASES, phase_error_rad=0.05, polarisations=2),
    "noisy heterodyne qpsk": replace(QPSK_BESIDE, **NOISY_PHASES, polarisations=2),
    "ppm": PPM,
    "noisy ppm": NOISY_PPM,
    "coded ppm": replace(NOISY_PPM, code_gain_db=4.0, code_rate=0.5),
    "ppm with its code": replace(NOISY_PPM, code_gap_db=1.0, code_rate=0.5),
    "coded pin": replace(PIN, code_gain_db=5.5, code_rate=0.874),
}
every_receiver = pytest.mark.parametrize("receiver", ALL.values(), ids=ALL.keys())


def near(value, rel=1e-6):
    return pytest.approx(value, rel=rel, abs=0.0)  # the default absolute tolerance would pass any small ratio


# -------------------------------------------------------------------------------------------------- published numbers
@pytest.mark.promise("choose-11", "choose-12")
@pytest.mark.promise("readme-7")
@pytest.mark.promise("link-23")
@pytest.mark.parametrize(
    ("receiver", "photons"),
    [(BPSK, 8.99), (BPSK_BESIDE, 17.99), (QPSK, 17.99), (QPSK_BESIDE, 17.99), (DPSK, 20.03), (COUNTER, 10.02)],
)
def test_ideal_receivers_need_the_published_photons_per_bit_at_any_rate(receiver, photons):
    assert receiver.photons_per_bit([1e6, 1e9]) == pytest.approx([photons, photons], abs=0.005)


@pytest.mark.promise("choose-12")
@pytest.mark.promise("link-23")
def test_a_photodiode_without_noise_of_its_own_needs_half_q_squared():
    pin = OokPin(**COMMON, quantum_efficiency=1.0, thermal_noise_a_sqrt_hz=0.0)
    assert float(pin.photons_per_bit(1e9)) == near(stats.norm.isf(1e-9) ** 2 / 2.0, rel=1e-9)


@pytest.mark.promise("choose-12")
@pytest.mark.promise("link-23")
def test_ppm_without_background_is_an_erasure_channel():
    for order in (2, 16, 256):
        ppm = replace(PPM, order=order)
        power = 3.0 * PHOTON_J * 1e8
        counts = 3.0 * math.log2(order)
        assert float(ppm.bit_error_ratio_at(power, 1e8)) == near(0.5 * math.exp(-counts), rel=1e-12)
        assert float(ppm.photons_per_bit(1e8)) == near(math.log(0.5e9) / math.log2(order), rel=1e-12)


def test_mcintyre_noise_has_its_textbook_limits():
    assert apd_excess_noise_factor(1.0, 0.3) == near(1.0)
    assert apd_excess_noise_factor(100.0, 1.0) == near(100.0)
    assert apd_excess_noise_factor(100.0, 0.0) == near(1.99)
    assert apd_excess_noise_factor(10.0, 0.02) == near(0.2 + 0.98 * 1.9)


# ----------------------------------------------------------------------------------------- curves in an independent way
@pytest.mark.promise("link-23", "link-24")
@pytest.mark.parametrize("rate", [1e5, 1e7, 1e9])
@pytest.mark.parametrize("photons", [3.0, 40.0, 300.0])
def test_counting_errs_as_the_best_of_all_thresholds_on_poisson_counts(rate, photons):
    counter = NOISY_COUNTER
    floor = (0.4 * counter.background_power_w / PHOTON_J + 2e5) / rate
    space = 2.0 * photons * 0.4 / 16.0
    thresholds = np.arange(5000)
    errors = 0.5 * (stats.poisson.cdf(thresholds, 15.0 * space + floor) + stats.poisson.sf(thresholds, space + floor))
    got = float(counter.bit_error_ratio_at(photons * PHOTON_J * rate, rate))
    assert got == near(errors.min(), rel=1e-9)


def _correct_words(order, pulse, floor):
    # Sum over counts and over the number of slots that tie
    k = np.arange(0, int(floor + pulse + 12.0 * math.sqrt(floor + pulse) + 60.0))
    below = stats.poisson.cdf(k - 1, floor)
    here = stats.poisson.pmf(k, floor)
    won = sum(
        math.comb(order - 1, ties) * here**ties * below ** (order - 1 - ties) / (ties + 1) for ties in range(order)
    )
    return float((stats.poisson.pmf(k, floor + pulse) * won).sum())


@pytest.mark.promise("link-23")
@pytest.mark.parametrize("order", [2, 16])
@pytest.mark.parametrize(("pulse", "floor"), [(2.0, 0.01), (6.0, 0.5), (20.0, 5.0), (40.0, 60.0), (250.0, 2500.0)])
def test_ppm_with_background_errs_as_the_sum_over_counts_and_ties(order, pulse, floor):
    rate = 1e8
    slot_rate = rate * order / math.log2(order)
    ppm = replace(PPM, order=order, dark_count_rate_hz=floor * slot_rate)
    power = pulse * slot_rate * PHOTON_J / order
    want = (1.0 - _correct_words(order, pulse, floor)) * order / (2.0 * (order - 1.0))
    assert float(ppm.bit_error_ratio_at(power, rate)) == pytest.approx(want, rel=1e-7, abs=1e-14)


def test_ppm_of_order_256_with_background_errs_as_often_as_simulated_slots():
    random = np.random.Generator(np.random.Philox(key=5))
    order, pulse, floor, words = 256, 5.0, 0.3, 16_000
    slots = random.poisson(floor, (words, order)).astype(float)
    slots[:, 0] += random.poisson(pulse, words)
    slots += random.uniform(0.0, 0.5, slots.shape)  # ties at random
    wrong = int((slots.argmax(axis=1) != 0).sum())
    slot_rate = 1e8 * order / 8.0
    ppm = replace(PPM, order=order, background_power_w=floor * slot_rate * PHOTON_J)
    ratio = float(ppm.bit_error_ratio_at(pulse * slot_rate * PHOTON_J / order, 1e8))
    low, high = stats.binomtest(wrong, words).proportion_ci(0.99)
    assert low < ratio * 2.0 * (order - 1.0) / order < high


def test_small_ppm_error_ratios_keep_their_digits():
    # Two slots: the difference of two Poisson counts is Skellam, summed here in its tail
    pulse, floor, rate = 60.0, 2.0, 1e8
    ppm = replace(PPM, order=2, dark_count_rate_hz=floor * 2.0 * rate)
    k = np.arange(-200, 0)
    law = stats.skellam(floor + pulse, floor)
    want = float(law.pmf(k).sum() + 0.5 * law.pmf(0))
    assert want < 1e-11
    assert float(ppm.bit_error_ratio_at(pulse * rate * PHOTON_J, rate)) == near(want, rel=1e-6)


@pytest.mark.promise("link-23", "link-24")
@pytest.mark.parametrize("receiver", [PIN, APD, PREAMPLIFIED], ids=["pin", "apd", "preamplified"])
def test_the_lines_of_noise_and_both_tails_at_the_threshold_give_the_error_ratio(receiver):
    rate = 2e9
    power = float(receiver.required_power_w(rate)) * 0.6
    lines = receiver.noise_lines(power, rate)
    gain = {PIN: 1.0, APD: 12.0, PREAMPLIFIED: 10.0**3.5}[receiver]
    per_watt = gain * getattr(receiver, "quantum_efficiency", 1.0) * ELEMENTARY_CHARGE_C / PHOTON_J
    r = receiver.extinction_ratio
    mark, space = 2.0 * power * r / (r + 1.0) * per_watt, 2.0 * power / (r + 1.0) * per_watt
    s1 = math.sqrt(sum(line.value**2 for line in lines if not line.name.endswith("spaces")))
    s0 = math.sqrt(sum(line.value**2 for line in lines if not line.name.endswith("marks")))
    threshold = (s0 * mark + s1 * space) / (s0 + s1)
    want = 0.5 * (stats.norm.cdf(threshold, mark, s1) + stats.norm.sf(threshold, space, s0))
    assert float(receiver.bit_error_ratio_at(power, rate)) == near(want, rel=1e-9)


def test_the_terms_of_a_photodiode_are_shot_and_thermal_noise():
    lines = {line.name: line for line in APD.noise_lines(1e-6, 1e9)}
    b, r = 0.5e9, 0.7 * ELEMENTARY_CHARGE_C / PHOTON_J
    f = apd_excess_noise_factor(12.0, 0.4)
    shot = 2.0 * ELEMENTARY_CHARGE_C * 144.0 * f * b
    assert lines["Signal shot noise, marks"].value == near(math.sqrt(shot * r * 2e-6 * 20.0 / 21.0))
    assert lines["Signal shot noise, spaces"].value == near(math.sqrt(shot * r * 2e-6 / 21.0))
    assert lines["Background shot noise"].value == near(math.sqrt(shot * r * 1e-9))
    assert lines["Dark current shot noise"].value == near(math.sqrt(shot * 2e-9))
    assert lines["Thermal noise"].value == near(3e-12 * math.sqrt(b))
    assert {line.unit for line in lines.values()} == {"A"}


def test_shot_noise_is_the_spread_of_poisson_electrons_over_half_a_symbol_rate_of_bandwidth():
    random = np.random.Generator(np.random.Philox(key=11))
    rate, power = 1e9, 2e-6
    electrons = 2.0 * power * 10.0 / 11.0 * 0.8 / PHOTON_J / rate
    currents = random.poisson(electrons, 200_000) * ELEMENTARY_CHARGE_C * rate
    line = next(line for line in PIN.noise_lines(power, rate) if line.name == "Signal shot noise, marks")
    assert line.value == near(float(currents.std()), rel=0.01)


def test_the_beats_of_a_preamplifier_are_those_of_simulated_fields():
    # Complex noise of N photons per mode in both polarisations, many modes: the detector adds their energies
    random = np.random.Generator(np.random.Philox(key=3))
    modes, noise, photons, symbols = 40, 10.0**0.4 / 2.0, 900.0, 40_000
    parts = random.standard_normal((symbols, 4 * modes)) * math.sqrt(noise / 2.0)
    dark = (parts**2).sum(axis=1)
    parts[:, 0] += math.sqrt(photons)
    lit = (parts**2).sum(axis=1)
    rate = 1e9
    receiver = replace(PREAMPLIFIED, optical_bandwidth_hz=(modes + 0.25) * rate, extinction_ratio=math.inf)
    per_photon = 10.0**3.5 * ELEMENTARY_CHARGE_C * rate
    lines = {line.name: line.value / per_photon for line in receiver.noise_lines(photons * PHOTON_J * rate / 2.0, rate)}
    assert lines["ASE-ASE beat noise"] == near(float(dark.std()), rel=0.02)
    assert lines["Signal-ASE beat noise, marks"] ** 2 == near(float(lit.var() - dark.var()), rel=0.04)


@pytest.mark.promise("choose-12", "link-23")
@pytest.mark.parametrize(
    ("modes", "polarisations", "exact"), [(1, 1, 38.3), (1, 2, 40.7), (2, 1, 40.7), (5, 2, 51.2), (20, 2, 70.6)]
)
def test_gaussian_beats_cost_less_than_a_third_of_a_decibel_against_chi_square(modes, polarisations, exact):
    rate, degrees = 1e9, 2 * modes * polarisations
    receiver = OokPreamplified(
        **COMMON, noise_figure_db=3.0, gain_db=60.0, optical_bandwidth_hz=modes * rate, polarisations=polarisations
    )

    def log_ratio(photons):
        def at(threshold):
            error = stats.chi2.sf(threshold, degrees) + stats.ncx2.cdf(threshold, degrees, 4.0 * photons)
            return math.log(0.5 * error)

        return optimize.minimize_scalar(at, bounds=(20.0, 4.0 * photons), method="bounded").fun

    needed = optimize.brentq(lambda photons: log_ratio(photons) - math.log(1e-9), 20.0, 200.0, xtol=1e-3)
    assert needed == pytest.approx(exact, abs=0.05)
    assert 0.175 < 10.0 * math.log10(float(receiver.photons_per_bit(rate)) / needed) < 0.335


@pytest.mark.promise("link-23")
@pytest.mark.parametrize(("polarisations", "photons"), [(1, 41.2), (2, 43.3)])
def test_gaussian_beats_of_an_ideal_amplifier_need_so_many_photons(polarisations, photons):
    ideal = OokPreamplified(
        **COMMON, noise_figure_db=3.0, gain_db=60.0, optical_bandwidth_hz=1e9, polarisations=polarisations
    )
    assert float(ideal.photons_per_bit(1e9)) == pytest.approx(photons, abs=0.05)
    assert PREAMPLIFIED.polarisations == 2


@pytest.mark.promise("link-23")
def test_dpsk_errs_as_two_fields_of_which_the_empty_port_is_the_brighter():
    photons, noise, rate = 6.0, 10.0**0.45 / 2.0 + 0.2, 1e9
    # amplitudes over two symbols: Rice in one port, Rayleigh in the other
    sigma = math.sqrt(noise / 2.0)
    signal = stats.rice(math.sqrt(2.0 * photons) / sigma, scale=sigma)
    want, _ = integrate.quad(lambda r: signal.pdf(r) * math.exp(-(r**2) / noise), 0.0, 20.0, epsabs=1e-12)
    assert float(NOISY_DPSK.bit_error_ratio_at(photons * PHOTON_J * rate, rate)) == near(want, rel=1e-8)


def test_dpsk_errs_as_often_as_simulated_symbols_and_has_their_noise():
    random = np.random.Generator(np.random.Philox(key=7))
    photons, noise, rate, bits = 6.0, 10.0**0.45 / 2.0 + 0.2, 1e9, 400_000
    fields = random.standard_normal((2, 2, bits)) * math.sqrt(noise / 2.0)
    first, second = math.sqrt(photons) + fields[0] + 0.0, fields[1]
    decision = first[0] * first[1] + second[0] * second[1]
    low, high = stats.binomtest(int((decision < 0.0).sum()), bits).proportion_ci(0.99)
    power = photons * PHOTON_J * rate
    assert low < float(NOISY_DPSK.bit_error_ratio_at(power, rate)) < high
    lines = NOISY_DPSK.noise_lines(power, rate)
    assert math.hypot(*(line.value for line in lines)) == near(float(decision.std()), rel=0.01)


@pytest.mark.promise("link-23")
def test_homodyne_errs_as_often_as_simulated_quadratures_and_has_their_noise():
    random = np.random.Generator(np.random.Philox(key=8))
    photons, rate, bits, q, background = 1.5, 1e9, 400_000, 0.7, 0.3
    incoming = math.sqrt(photons) + math.sqrt(background / 2.0) * random.standard_normal(bits)
    detected = math.sqrt(q) * incoming + 0.5 * random.standard_normal(bits)
    low, high = stats.binomtest(int((detected < 0.0).sum()), bits).proportion_ci(0.99)
    power = photons * PHOTON_J * rate
    assert low < float(NOISY_BPSK.bit_error_ratio_at(power, rate)) < high
    assert float(BPSK.bit_error_ratio_at(power, rate)) == near(0.5 * math.erfc(math.sqrt(2.0 * photons)))
    lines = NOISY_BPSK.noise_lines(power, rate)
    assert math.hypot(*(line.value for line in lines)) == near(float(detected.std()), rel=0.01)


@pytest.mark.promise("link-92")
@pytest.mark.parametrize("phase_error", [0.0, 0.3])
@pytest.mark.parametrize("ideal", [BPSK, BPSK_BESIDE, QPSK, QPSK_BESIDE], ids=lambda each: type(each).__name__)
def test_phases_err_as_often_as_simulated_fields_behind_their_detector(ideal, phase_error):
    # fields in photons with a vacuum of 1/4 in each quadrature; what is behind splitters and beside the light is drawn
    random = np.random.Generator(np.random.Philox(key=21))
    q, background, per_bit, rate, count = 0.7, 0.3, 1.6, 1e9, 300_000
    bits = random.choice([-1.0, 1.0], (2, count))
    four = isinstance(ideal, QpskHomodyne | QpskHeterodyne)
    photons = per_bit * (2.0 if four else 1.0)
    sent = (bits[0] + 1j * bits[1]) / math.sqrt(2.0) if four else bits[0] + 0.0j

    def field(mean):  # complex amplitude of light with thermal photons, its vacuum left out
        return math.sqrt(mean / 2.0) * (random.standard_normal(count) + 1j * random.standard_normal(count))

    def vacuum():
        return 0.5 * (random.standard_normal(count) + 1j * random.standard_normal(count))

    light = math.sqrt(photons) * sent * np.exp(1j * phase_error * random.standard_normal(count)) + field(background)
    if isinstance(ideal, BpskHeterodyne | QpskHeterodyne):
        seen = math.sqrt(q) * (light + field(background)) + vacuum() + vacuum()  # the image band on top
    elif four:
        seen = math.sqrt(q / 2.0) * light + vacuum()  # each arm has half of the light and its own vacuum
    else:
        seen = math.sqrt(q) * light + vacuum()
    wrong = [np.sign(seen.real) != bits[0]] + ([np.sign(seen.imag) != bits[1]] if four else [])
    receiver = replace(
        ideal,
        bit_error_ratio=1e-2,
        quantum_efficiency=q,
        background_photons_per_mode=background,
        phase_error_rad=phase_error,
    )
    found = float(receiver.bit_error_ratio_at(per_bit * PHOTON_J * rate, rate))
    assert abs(found - np.mean(wrong)) < 4.0 * math.sqrt(2.0 * found / np.size(wrong))
    if not phase_error:
        lines = receiver.noise_lines(per_bit * PHOTON_J * rate, rate)
        assert math.hypot(*(line.value for line in lines)) == near(float((seen.real * bits[0]).std()), rel=0.01)


@pytest.mark.promise("link-92")
@pytest.mark.parametrize(("ideal", "bits"), [(BPSK, 1), (BPSK_BESIDE, 1), (QPSK, 2), (QPSK_BESIDE, 2)])
def test_bits_of_a_symbol_and_polarisations_slow_the_line_and_cost_no_photons(ideal, bits):
    both = replace(ideal, polarisations=2)
    assert float(ideal.symbol_rate_hz(1e9)) == near(1e9 / bits)
    assert float(both.symbol_rate_hz(1e9)) == near(0.5e9 / bits)
    assert both.highest_data_rate_bit_s == near(2.0 * ideal.highest_data_rate_bit_s)
    assert float(both.photons_per_bit(1e9)) == near(float(ideal.photons_per_bit(1e9)), rel=1e-12)
    assert float(both.bit_error_ratio_at(1e-9, 1e9)) == near(float(ideal.bit_error_ratio_at(1e-9, 1e9)), rel=1e-12)


@pytest.mark.promise("link-92")
def test_heterodyne_detection_needs_twice_the_light_of_one_quadrature_and_no_more_than_two():
    dark, lit = ({"background_photons_per_mode": each} for each in (0.0, 0.3))

    def photons(ideal, others):
        return float(replace(ideal, **others).photons_per_bit(1e9))

    for others in (dark, lit):
        assert photons(BPSK_BESIDE, others) == near(2.0 * photons(BPSK, others), rel=1e-12)
        assert photons(QPSK_BESIDE, others) == near(photons(BPSK_BESIDE, others), rel=1e-12)
    assert photons(QPSK, dark) == near(photons(QPSK_BESIDE, dark), rel=1e-12)
    assert photons(QPSK, lit) == near(photons(QPSK_BESIDE, lit) * 1.3 / 1.6, rel=1e-12)


@pytest.mark.promise("link-92")
def test_four_phases_stand_less_error_than_two():
    two, four = (float(replace(each, phase_error_rad=0.1).photons_per_bit(1e9)) for each in (BPSK_BESIDE, QPSK_BESIDE))
    assert 10.0 * math.log10(two / 17.987) == pytest.approx(0.054, abs=0.001)
    assert 10.0 * math.log10(four / 17.987) == pytest.approx(3.067, abs=0.002)


@pytest.mark.promise("link-92")
@pytest.mark.parametrize(("ideal", "limit"), [(BPSK, "0.257"), (QPSK, "0.13")])
def test_a_phase_error_that_no_power_makes_up_for_is_refused_with_the_limit(ideal, limit):
    with pytest.raises(ValueError, match=f"no power reaches a bit error ratio of 1e-09 above {limit} rad rms"):
        replace(ideal, phase_error_rad=0.3)
    assert np.isfinite(replace(ideal, phase_error_rad=float(limit)).required_power_w(1e9))


def test_a_code_of_pulse_positions_has_one_of_both_gains():
    with pytest.raises(ValueError, match="code_gain_db stands beside code_gap_db"):
        replace(PPM, code_gap_db=1.0, code_gain_db=1.0)


def test_counts_in_the_lines_are_roots_of_their_means():
    lines = {line.name: line for line in NOISY_PPM.noise_lines(1e-9, 1e8)}
    slot_s = math.log2(16) / (16 * 1e8)
    assert lines["Signal shot noise, pulse"].value ** 2 == near(0.5 * 16e-9 * slot_s / PHOTON_J)
    assert lines["Background shot noise"].value ** 2 == near(0.5 * 1e-11 * slot_s / PHOTON_J)
    assert lines["Dark counts"].value ** 2 == near(1e5 * slot_s)
    marks, spaces, background, dark = NOISY_COUNTER.noise_lines(1e-9, 1e8)
    counter = NOISY_COUNTER
    counts = counter.detection_efficiency * 1e-9 / PHOTON_J / 1e8  # of a symbol, the mean of a mark and a space
    assert [marks.value**2, spaces.value**2] == near([counts * 2.0 * 15.0 / 16.0, counts * 2.0 / 16.0])
    assert background.value**2 == near(counts * counter.background_power_w / 1e-9)
    assert dark.value**2 == near(counter.dark_count_rate_hz / 1e8)
    assert {line.unit for line in (*lines.values(), marks, spaces)} == {"count"}


# ----------------------------------------------------------------------------------------- what holds for all of them
@every_receiver
def test_the_required_power_meets_the_target(receiver):
    rates = np.geomspace(1e4, 1e10, 25)
    power = receiver.required_power_w(rates)
    assert receiver.bit_error_ratio_at(power, rates) == near(np.full(25, 1e-9), rel=1e-7)
    for target in (1e-3, 1e-12, 0.4):
        other = replace(receiver, bit_error_ratio=target)
        assert float(other.bit_error_ratio_at(other.required_power_w(1e8), 1e8)) == near(target, rel=1e-7)


@every_receiver
def test_more_power_errs_less_and_no_power_is_a_guess(receiver):
    powers = float(receiver.required_power_w(1e8)) * np.linspace(0.0, 1.5, 200)
    ratios = receiver.bit_error_ratio_at(powers, 1e8)
    assert ratios[0] == near(0.5, rel=1e-9)
    assert np.all(np.diff(ratios) < 0.0)
    assert float(receiver.bit_error_ratio_at(1e3, 1e4)) == 0.0  # a kilowatt, and still a number


@pytest.mark.promise("choose-10")
@every_receiver
def test_a_higher_rate_needs_more_power(receiver):
    assert np.all(np.diff(receiver.required_power_w(np.geomspace(1e4, 1e10, 25))) > 0.0)


@every_receiver
def test_arrays_give_what_scalars_give(receiver):
    rates = np.geomspace(1e5, 1e10, 7)
    power = receiver.required_power_w(rates)
    one_by_one = [float(receiver.required_power_w(rate)) for rate in rates]
    assert power == near(one_by_one, rel=1e-10)
    assert receiver.photons_per_bit(rates) == near(power / (rates * PHOTON_J), rel=1e-12)
    table = receiver.bit_error_ratio_at(power[:, None], rates)
    assert table.shape == (7, 7)
    assert table[2, 3] == near(float(receiver.bit_error_ratio_at(power[2], rates[3])), rel=1e-9)
    assert receiver.required_power_w(rates[:6].reshape(2, 3)).shape == (2, 3)
    assert receiver.required_power_w([]).shape == (0,)


@pytest.mark.promise("link-25", "link-26")
@every_receiver
def test_the_net_code_gain_is_power_at_the_same_information_rate(receiver):
    receiver = replace(receiver, code_gap_db=None) if isinstance(receiver, PpmCounting) else receiver
    coded = replace(receiver, code_gain_db=receiver.code_gain_db + 3.0, code_rate=0.5)
    rates = np.array([1e6, 1e9])
    assert coded.required_power_w(rates) * 10.0**0.3 == near(receiver.required_power_w(rates), rel=1e-12)
    assert coded.photons_per_bit(rates) * 10.0**0.3 == near(receiver.photons_per_bit(rates), rel=1e-12)


@pytest.mark.promise("link-26")
@every_receiver
def test_the_line_rate_of_the_code_fills_the_bandwidth(receiver):
    receiver = replace(receiver, code_gap_db=None) if isinstance(receiver, PpmCounting) else receiver
    slots = 4.0 if isinstance(receiver, PpmCounting) else 1.0
    slots /= 4.0 if isinstance(receiver, QpskHomodyne | QpskHeterodyne) else 1.0  # two bits, two polarisations
    limited = replace(receiver, bandwidth_hz=slots * 2e9, code_rate=0.5, code_gain_db=1.0)
    assert limited.symbol_rate_hz(1e9) == near(slots * 2e9)
    assert np.isfinite(limited.required_power_w(1e9))
    with pytest.raises(RateError, match=r"the data rate is 1\.01 Gbit/s.* at most 1 Gbit/s of data"):
        limited.required_power_w([1e8, 1.01e9])
    with pytest.raises(RateError, match="at most 1 Gbit/s of data"):
        limited.bit_error_ratio_at(1e-9, 1.01e9)
    with pytest.raises(RateError, match="at most 1 Gbit/s of data"):
        limited.noise_lines(1e-9, 1.01e9)


@every_receiver
def test_every_line_of_noise_has_its_formula_its_source_and_its_regime(receiver):
    for line in receiver.noise_lines(1e-9, 1e8):
        assert isinstance(receiver, Receiver)
        assert line.value >= 0.0
        assert line.unit and line.basis and line.source and line.regime


# ------------------------------------------------------------------------------------------------------------- scaling
def test_thermal_noise_asks_for_the_root_of_the_rate_and_quantum_noise_for_the_rate():
    pin = OokPin(**COMMON, quantum_efficiency=0.8, thermal_noise_a_sqrt_hz=1e-9)
    low, high = pin.required_power_w([1e6, 1e8])
    assert high / low == near(10.0, rel=1e-3)
    for receiver in (COUNTER, DPSK, BPSK, PPM):
        low, high = receiver.required_power_w([1e6, 1e8])
        assert high / low == near(100.0, rel=1e-9)


def test_much_background_asks_for_the_root_of_the_rate_from_counters_too():
    for receiver in (replace(COUNTER, background_power_w=1e-6), replace(PPM, background_power_w=1e-6)):
        low, high = receiver.required_power_w([1e2, 1e4])
        assert high / low == near(10.0, rel=1e-3)


@pytest.mark.parametrize("floor", [1e9, 1e12])
def test_very_many_counts_become_gaussian_down_to_the_last_tail(floor):
    # scipy's own Poisson tails are wrong by tens of percent here
    rate, pulse = 1e3, 12.0 * math.sqrt(floor)
    counter = replace(COUNTER, dark_count_rate_hz=floor * rate)
    got = float(counter.bit_error_ratio_at(pulse * rate * PHOTON_J / 2.0, rate))
    assert got == near(stats.norm.sf(pulse / (math.sqrt(floor + pulse) + math.sqrt(floor))), rel=1e-3)
    ppm = replace(PPM, order=2, dark_count_rate_hz=floor * 2.0 * rate)
    got = float(ppm.bit_error_ratio_at(pulse * rate * PHOTON_J, rate))
    assert got == near(stats.norm.sf(pulse / math.sqrt(2.0 * floor + pulse)), rel=1e-6)


@pytest.mark.parametrize("floor", [500.0, 2e5])
def test_counts_in_the_hundreds_and_beyond_the_expansion_are_still_poisson(floor):
    rate, pulse = 1e3, 9.0 * math.sqrt(floor)
    k = np.arange(int(floor - 12.0 * math.sqrt(floor)), int(floor + 25.0 * math.sqrt(floor)))
    counter = replace(COUNTER, dark_count_rate_hz=floor * rate)
    errors = 0.5 * (stats.poisson.cdf(k, floor + pulse) + stats.poisson.sf(k, floor))
    got = float(counter.bit_error_ratio_at(pulse * rate * PHOTON_J / 2.0, rate))
    assert got == near(errors.min(), rel=1e-8)
    lost = stats.poisson.sf(k, floor) + 0.5 * stats.poisson.pmf(k, floor)
    ppm = replace(PPM, order=2, dark_count_rate_hz=floor * 2.0 * rate)
    got = float(ppm.bit_error_ratio_at(pulse * rate * PHOTON_J, rate))
    assert got == near(float((stats.poisson.pmf(k, floor + pulse) * lost).sum()), rel=1e-7)


@pytest.mark.parametrize("extinction_ratio", [1.3, 10.0, math.inf])
@pytest.mark.parametrize(("background_w", "rate"), [(1e-9, 3e5), (1e-3, 3e8), (1e-3, 3e5), (1e-2, 3e7)])
def test_a_bright_background_leaves_a_ratio_that_falls_from_a_guess_to_nothing(extinction_ratio, background_w, rate):
    counter = replace(COUNTER, background_power_w=background_w, extinction_ratio=extinction_ratio)
    power = float(counter.required_power_w(rate)) * np.concatenate([[0.0], np.logspace(-30, 10, 8001)])
    ratio = counter.bit_error_ratio_at(power, rate)
    assert np.all((ratio >= 0.0) & (ratio <= 0.5 * (1 + 1e-12)))
    assert np.all(np.diff(ratio) <= 1e-10 * ratio[:-1])
    assert (ratio[0], ratio[-1]) == (near(0.5, rel=1e-9), 0.0)


def test_poisson_tails_meet_where_the_expansion_begins():
    # one count more in a slot on either side of 1e5 counts: nothing jumps
    rate = 1e3
    for receiver, slots in ((COUNTER, 1.0), (replace(PPM, order=2), 2.0)):
        floors = 1e5 + np.linspace(-3000.0, 1000.0, 81)
        ratios = [
            float(
                replace(receiver, dark_count_rate_hz=f * slots * rate).bit_error_ratio_at(
                    3000.0 * rate * PHOTON_J, rate
                )
            )
            for f in floors
        ]
        steps = np.diff(np.log(ratios), 2)
        assert np.abs(steps).max() < 2e-3 * np.abs(np.diff(np.log(ratios))).max()


@pytest.mark.promise("choose-11")
def test_an_avalanche_of_gain_one_is_a_pin_and_ten_is_better_where_thermal_noise_rules():
    fields = {**COMMON, "quantum_efficiency": 0.8, "thermal_noise_a_sqrt_hz": 5e-12}
    pin = OokPin(**fields)
    apd = OokApd(**fields, gain=1.0, ionisation_ratio=0.4)
    assert float(apd.required_power_w(1e9)) == near(float(pin.required_power_w(1e9)), rel=1e-12)
    gained = float(replace(apd, gain=10.0).required_power_w(1e9)) / float(pin.required_power_w(1e9))
    assert 0.1 < gained < 0.2


def test_a_noise_figure_counts_decibel_for_decibel_above_the_quantum_limit():
    worse = replace(DPSK, noise_figure_db=10.0 * math.log10(2.0) + 2.0)
    assert 10.0 * np.log10(worse.photons_per_bit(1e9) / DPSK.photons_per_bit(1e9)) == pytest.approx(2.0, abs=1e-9)
    hot = replace(DPSK, background_photons_per_mode=0.25)
    assert float(hot.photons_per_bit(1e9)) == pytest.approx(1.25 * 20.0301, abs=1e-3)


def test_a_finite_extinction_ratio_costs_power():
    for receiver in (PIN, APD, PREAMPLIFIED, NOISY_COUNTER):
        worse = replace(receiver, extinction_ratio=4.0)
        assert worse.required_power_w(1e9) > receiver.required_power_w(1e9)


def test_the_optical_filter_bounds_the_rate_of_a_preamplified_receiver():
    narrow = replace(PREAMPLIFIED, optical_bandwidth_hz=2e9)
    assert np.isfinite(narrow.required_power_w(2e9))
    with pytest.raises(RateError, match="the receiver takes 2 GHz, so at most 2 Gbit/s of data"):
        narrow.required_power_w(2.1e9)


# ---------------------------------------------------------------------------------------------------------- background
@pytest.mark.promise("link-27")
def test_background_power_is_radiance_over_the_cone_of_the_field():
    for field in (1e-4, 0.5, math.pi):
        solid, _ = integrate.quad(lambda t: 2.0 * math.pi * math.sin(t) * math.cos(t), 0.0, field / 2.0)
        assert background_power_w(1e7, 0.02, field, 1e-9) == near(1e7 * 0.02 * solid * 1e-9, rel=1e-9)
    # full angle: a field of 100 urad is a solid angle of pi (50 urad)^2
    assert background_power_w(1.0, 1.0, 1e-4, 1.0) == near(math.pi * 25e-10, rel=1e-6)


@pytest.mark.promise("link-27")
def test_a_black_body_gives_its_bose_number_to_a_mode():
    x = PLANCK_J_S * SPEED_OF_LIGHT_M_S / (WAVELENGTH_M * 1.380649e-23 * 5772.0)
    radiance = 2.0 * PLANCK_J_S * SPEED_OF_LIGHT_M_S**2 / WAVELENGTH_M**5 / math.expm1(x)
    photons = background_photons_per_mode(radiance, WAVELENGTH_M)
    assert photons == near(1.0 / math.expm1(x), rel=1e-12)
    assert photons == pytest.approx(0.25, abs=0.01)
    # the same through an aperture and a field that pass one mode, area times solid angle the squared wavelength
    field = 2.0 * math.sqrt(WAVELENGTH_M**2 / (math.pi * 0.01))
    power = background_power_w(radiance, 0.01, field, 1e-9) / 2.0
    per_hz = power / (SPEED_OF_LIGHT_M_S * 1e-9 / WAVELENGTH_M**2)
    assert per_hz / PHOTON_J == near(photons, rel=1e-6)


# ------------------------------------------------------------------------------------------------------------ refusals
@pytest.mark.parametrize(
    ("receiver", "change", "message"),
    [
        (
            PIN,
            {"bit_error_ratio": 0.5},
            r"OokPin\.bit_error_ratio is 0\.5: it must be finite, at least 1e-18 and below 0\.5",
        ),
        (
            PIN,
            {"bit_error_ratio": 0.0},
            r"OokPin\.bit_error_ratio is 0: it must be finite, at least 1e-18 and below 0\.5",
        ),
        (
            PIN,
            {"bit_error_ratio": math.nan},
            r"OokPin\.bit_error_ratio is nan: it must be finite, at least 1e-18 and below 0\.5",
        ),
        (PIN, {"wavelength_m": 0.0}, r"OokPin\.wavelength_m is 0 m: it must be finite, above 0 m"),
        (PIN, {"bandwidth_hz": -1.0}, r"OokPin\.bandwidth_hz is -1 Hz: it must be finite, above 0 Hz"),
        (DPSK, {"code_gain_db": -0.1}, r"DpskPreamplified\.code_gain_db is -0\.1 dB: it must be finite, at least 0 dB"),
        (DPSK, {"code_rate": 0.0}, r"DpskPreamplified\.code_rate is 0: it must be finite, above 0, at most 1"),
        (DPSK, {"code_rate": 1.01}, r"DpskPreamplified\.code_rate is 1\.01: it must be finite, above 0, at most 1"),
        (
            PIN,
            {"quantum_efficiency": 1.01},
            r"OokPin\.quantum_efficiency is 1\.01: it must be finite, above 0, at most 1",
        ),
        (
            BPSK,
            {"quantum_efficiency": 0.0},
            r"BpskHomodyne\.quantum_efficiency is 0: it must be finite, above 0, at most 1",
        ),
        (
            COUNTER,
            {"detection_efficiency": 1.2},
            r"OokCounting\.detection_efficiency is 1\.2: it must be finite, above 0, at most 1",
        ),
        (
            PPM,
            {"detection_efficiency": 0.0},
            r"PpmCounting\.detection_efficiency is 0: it must be finite, above 0, at most 1",
        ),
        (
            COUNTER,
            {"dark_count_rate_hz": -1.0},
            r"OokCounting\.dark_count_rate_hz is -1 Hz: it must be finite, at least 0 Hz",
        ),
        (
            PPM,
            {"background_power_w": -1e-12},
            r"PpmCounting\.background_power_w is -1 pW: it must be finite, at least 0 W",
        ),
        (PIN, {"background_power_w": -1e-12}, r"OokPin\.background_power_w is -1 pW: it must be finite, at least 0 W"),
        (PIN, {"dark_current_a": -1e-9}, r"OokPin\.dark_current_a is -1 nA: it must be finite, at least 0 A"),
        (
            PIN,
            {"thermal_noise_a_sqrt_hz": math.inf},
            r"OokPin\.thermal_noise_a_sqrt_hz is inf A/sqrt\(Hz\): it must be finite, at least 0 A/sqrt\(Hz\)",
        ),
        (PIN, {"extinction_ratio": 1.0}, r"OokPin\.extinction_ratio is 1: it must be finite, above 1"),
        (COUNTER, {"extinction_ratio": 0.9}, r"OokCounting\.extinction_ratio is 0\.9: it must be finite, above 1"),
        (APD, {"gain": 0.99}, r"OokApd\.gain is 0\.99: it must be finite, at least 1"),
        (
            APD,
            {"ionisation_ratio": 1.01},
            r"OokApd\.ionisation_ratio is 1\.01: it must be finite, at least 0, at most 1",
        ),
        (
            APD,
            {"ionisation_ratio": -0.01},
            r"OokApd\.ionisation_ratio is -0\.01: it must be finite, at least 0, at most 1",
        ),
        (
            PREAMPLIFIED,
            {"noise_figure_db": 2.99},
            r"OokPreamplified\.noise_figure_db is 2\.99 dB: it must be finite, at least 3 dB",
        ),
        (
            DPSK,
            {"noise_figure_db": 2.99},
            r"DpskPreamplified\.noise_figure_db is 2\.99 dB: it must be finite, at least 3 dB",
        ),
        (PREAMPLIFIED, {"gain_db": 9.0}, r"OokPreamplified\.gain_db is 9 dB: it must be finite, at least 10 dB"),
        (
            PREAMPLIFIED,
            {"polarisations": 3},
            r"OokPreamplified\.polarisations is 3: it must be finite, at least 1, at most 2",
        ),
        (
            PREAMPLIFIED,
            {"optical_bandwidth_hz": 0.0},
            r"OokPreamplified\.optical_bandwidth_hz is 0 Hz: it must be finite, above 0 Hz",
        ),
        (
            PREAMPLIFIED,
            {"background_photons_per_mode": -1.0},
            r"OokPreamplified\.background_photons_per_mode is -1 photon: it must be finite, at least 0 photon",
        ),
        (
            DPSK,
            {"background_photons_per_mode": -1.0},
            r"DpskPreamplified\.background_photons_per_mode is -1 photon: it must be finite, at least 0 photon",
        ),
        (
            BPSK,
            {"background_photons_per_mode": -1.0},
            r"BpskHomodyne\.background_photons_per_mode is -1 photon: it must be finite, at least 0 photon",
        ),
        (PPM, {"order": 1}, r"the order of the pulse-position modulation is 1: it is a power of two above 1"),
        (PPM, {"order": 12}, "order of the pulse-position modulation is 12: it is a power of two"),
    ],
)
def test_what_cannot_be_is_refused_with_its_value_and_limit(receiver, change, message):
    with pytest.raises(ValueError, match=message):
        replace(receiver, **change)


def test_the_bounds_themselves_are_taken():
    replace(APD, gain=1.0, ionisation_ratio=0.0, quantum_efficiency=1.0, extinction_ratio=math.inf)
    replace(APD, ionisation_ratio=1.0, code_gain_db=0.0, code_rate=1.0, bit_error_ratio=0.499)
    replace(PPM, order=2, dark_count_rate_hz=0.0, bit_error_ratio=1e-18)
    replace(PREAMPLIFIED, noise_figure_db=3.0, gain_db=10.0, polarisations=1)


@every_receiver
def test_negative_power_and_rates_that_are_none_are_refused(receiver):
    with pytest.raises(ValueError, match=r"the received power is -1 nW: it must be finite, at least 0 W"):
        receiver.bit_error_ratio_at([1e-9, -1e-9], 1e8)
    with pytest.raises(ValueError, match="received power is nan W"):
        receiver.noise_lines(math.nan, 1e8)
    with pytest.raises(ValueError, match=r"data rate is 0 bit/s: .* above 0 bit/s") as refused:
        receiver.required_power_w([1e8, 0.0])
    assert not isinstance(refused.value, RateError)
    with pytest.raises(ValueError, match="data rate is inf bit/s"):
        receiver.photons_per_bit(math.inf)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: background_power_w(-1.0, 1.0, 1.0, 1.0), "spectral radiance is -1 W"),
        (lambda: background_power_w(1.0, -1.0, 1.0, 1.0), "aperture's area is -1 m"),
        (
            lambda: background_power_w(1.0, 1.0, 3.2, 1.0),
            r"the field of view is 3\.2 rad: it must be finite, at least 0 rad, at most 3\.142 rad",
        ),
        (lambda: background_power_w(1.0, 1.0, 1.0, -1.0), "filter's bandwidth is -1 m"),
        (lambda: background_photons_per_mode(-1.0, 1e-6), "spectral radiance is -1 W"),
        (lambda: background_photons_per_mode(1.0, 0.0), "wavelength is 0 m"),
    ],
)
def test_background_that_cannot_be_is_refused(call, message):
    with pytest.raises(ValueError, match=message):
        call()


@pytest.mark.parametrize(("gamma", "above"), [(gammaincc, False), (gammainc, True)])
def test_temmes_expansion_has_its_second_term(gamma, above, monkeypatch):
    """Taken for a thousand counts, where scipy is exact: one term alone errs by 5e-8, two by 1e-10."""
    monkeypatch.setattr(counting, "_MANY", 100.0)
    count = np.full(13, 999.0)
    mean = 1000.0 + np.sqrt(1000.0) * np.linspace(-3.0, 3.0, 13)
    found = counting._tail(count, mean, above)
    assert_allclose(found, gamma(count + 1.0, mean), rtol=0, atol=1e-9)


@pytest.mark.parametrize("rates", [1e6, [1e6, 2e6]], ids=["one", "several"])
def test_a_search_without_a_root_asks_for_a_report(monkeypatch, rates):
    receiver = OokCounting(wavelength_m=1.5e-6, bit_error_ratio=1e-9, bandwidth_hz=1e9, detection_efficiency=1.0)
    monkeypatch.setattr(OokCounting, "_ratio_of_counts", lambda self, counts, floor: np.full(counts.shape, 0.4))
    with pytest.raises(ArithmeticError, match="please report the receiver"):
        receiver.required_power_w(rates)


LINE = {
    "wavelength_m": 1.064e-6,
    "bit_error_ratio": 3e-7,
    "bandwidth_hz": 2.7e9,
    "code_gain_db": 4.3,
    "code_rate": 0.78,
}
DIODE = {
    "quantum_efficiency": 0.67,
    "thermal_noise_a_sqrt_hz": 1.7e-12,
    "dark_current_a": 3e-9,
    "background_power_w": 7e-10,
}
PHASED = {"quantum_efficiency": 0.67, "background_photons_per_mode": 0.023, "phase_error_rad": 0.07}
KINDS_UNLIKE = {
    "apd": OokApd(**LINE, **DIODE, extinction_ratio=17.0, gain=11.0, ionisation_ratio=0.31),
    "pin": OokPin(**LINE, **DIODE, extinction_ratio=9.0),
    "ook": OokCounting(
        **LINE, detection_efficiency=0.43, dark_count_rate_hz=5e4, background_power_w=2e-13, extinction_ratio=31.0
    ),
    "ppm": PpmCounting(**LINE, detection_efficiency=0.43, dark_count_rate_hz=5e4, background_power_w=2e-13, order=8),
    "amplified": OokPreamplified(
        **LINE,
        noise_figure_db=4.6,
        gain_db=31.0,
        optical_bandwidth_hz=17e9,
        background_photons_per_mode=0.3,
        extinction_ratio=23.0,
        polarisations=1,
    ),
    "dpsk": DpskPreamplified(**LINE, noise_figure_db=3.7, background_photons_per_mode=0.3),
    "bpsk homodyne": BpskHomodyne(**LINE, **PHASED),
    "bpsk heterodyne": BpskHeterodyne(**LINE, **PHASED),
    "qpsk homodyne": QpskHomodyne(**LINE, **PHASED, polarisations=2),
    "qpsk heterodyne": QpskHeterodyne(**LINE, **PHASED),
}


def told_by(name):
    """Power, photons, gain and symbols at a rate, the highest rate, the ratio at a power, and the noise there."""
    r, rate = KINDS_UNLIKE[name], 155.52e6
    found = [r.required_power_w(rate), r.photons_per_bit(rate), r.net_gain_db(rate), r.symbol_rate_hz(rate)]
    found += [r.highest_data_rate_bit_s, r.bit_error_ratio_at(0.6 * found[0], rate)]
    return [*map(float, found), *(line.value for line in r.noise_lines(2.3e-9, rate))]


@pytest.mark.parametrize(("found", "expected"), [
    (lambda: told_by("apd"),
     [
        6.67975448e-09, 230.058958, 4.3, 199384615.0, 2106000000.0, 0.000667437212, 6.75602431e-09,
        1.63857658e-09, 2.71189643e-09, 7.40388494e-09, 1.6973826e-08,
    ]),
    (lambda: told_by("pin"),
     [
        6.07607382e-08, 2092.67454, 4.3, 199384615.0, 2106000000.0, 0.00134586596, 2.75756803e-10,
        9.19189344e-11, 1.13390086e-10, 3.09571981e-10, 1.6973826e-08,
    ]),
    (lambda: told_by("ook"),
     [
        4.43548682e-10, 15.276362, 4.3, 199384615.0, 2106000000.0, 5.79019175e-05, 7.17473106, 1.28861974,
        0.0480657641, 0.0158357698,
    ]),
    (lambda: told_by("ppm"),
     [
        1.20375961e-10, 4.14589612, 4.3, 531692308.0, 789750000.0, 9.24853635e-05, 8.92781944, 0.0294341491,
        0.00969738892,
    ]),
    (lambda: told_by("amplified"),
     [
        1.64903635e-09, 56.7948395, 4.3, 199384615.0, 2106000000.0, 0.000352252508, 8.16896271e-07,
        1.70334647e-07, 6.45944368e-07, 1.23346229e-08, 2.57194667e-09, 1.38135949e-08,
    ]),
    (lambda: told_by("dpsk"),
     [
        2.27508723e-10, 7.83568017, 4.3, 199384615.0, 2106000000.0, 9.24401741e-05, 9.53720955, 1.04094208,
    ]),
    (lambda: told_by("bpsk homodyne"),
     [
        1.03908554e-10, 3.57873837, 4.3, 199384615.0, 2106000000.0, 5.52168985e-05, 0.5, 0.0877781294,
    ]),
    (lambda: told_by("bpsk heterodyne"),
     [
        2.07817108e-10, 7.15747674, 4.3, 199384615.0, 2106000000.0, 5.52168985e-05, 0.707106781, 0.124137021,
    ]),
    (lambda: told_by("qpsk homodyne"),
     [
        2.37291889e-10, 8.17262442, 4.3, 49846153.8, 8424000000.0, 3.37789053e-05, 0.5, 0.0620685105,
    ]),
    (lambda: told_by("qpsk heterodyne"),
     [
        2.40893063e-10, 8.29665328, 4.3, 99692307.7, 4212000000.0, 3.37789053e-05, 0.707106781, 0.124137021,
    ]),
    (lambda: [background_power_w(3.1e6, 0.023, 0.0017, 2.3e-9), background_photons_per_mode(3.1e6,
            1.3e-6), apd_excess_noise_factor(17.0, 0.23)],
     [3.72224526e-10, 9.66386878e-08, 5.40470588]),
])  # fmt: skip
def test_receivers_of_numbers_unlike_each_other(found, expected):
    assert list(found()) == pytest.approx(expected, rel=1e-6, abs=0.0, nan_ok=True)


@pytest.mark.parametrize(
    ("found", "expected"),
    [
        (
            lambda: [
                f"{line.name}: {line.basis} | {line.regime}"
                for line in KINDS_UNLIKE["apd"].noise_lines(2.3e-9, 155.52e6)
            ],
            [
                "Signal shot noise, marks: sqrt(2 e M^2 F R P B) | Gaussian noise in 0.5 of the symbol rate",
                ("Signal shot noise, spaces: sqrt(2 e M^2 F R P B) | Gaussian noise in 0.5 of the symbol rate"),
                "Background shot noise: sqrt(2 e M^2 F R P B) | Gaussian noise in 0.5 of the symbol rate",
                "Dark current shot noise: sqrt(2 e M^2 F I B) | Gaussian noise in 0.5 of the symbol rate",
                "Thermal noise: density sqrt(B) | Gaussian noise in 0.5 of the symbol rate",
            ],
        ),
        (
            lambda: [f"{line.name}: {line.basis}" for line in KINDS_UNLIKE["amplified"].noise_lines(2.3e-9, 155.52e6)],
            [
                "Signal-ASE beat noise, marks: sqrt(4 I S B), S in A/Hz",
                "Signal-ASE beat noise, spaces: sqrt(4 I S B), S in A/Hz",
                "ASE-ASE beat noise: sqrt(2 p S^2 B (Bo - B/2)), S in A/Hz",
                "Signal shot noise, marks: sqrt(2 e I B)",
                "Signal shot noise, spaces: sqrt(2 e I B)",
                "ASE shot noise: sqrt(2 e p S Bo B), S in A/Hz",
            ],
        ),
        (
            lambda: [
                f"{line.name}: {line.basis} | {line.regime}"
                for line in KINDS_UNLIKE["qpsk homodyne"].noise_lines(2.3e-9, 155.52e6)
            ],
            [
                (
                    "Shot noise of the local oscillator: 1/2 | quadrature of the field, in which the signal is "
                    "sqrt(q n / 4); matched filter"
                ),
                (
                    "Background beat noise: sqrt(q N / 4) | quadrature of the field, in which the signal is "
                    "sqrt(q n / 4); matched filter"
                ),
            ],
        ),
        (
            lambda: [
                f"{line.name}: {line.basis} | {line.regime}"
                for line in KINDS_UNLIKE["bpsk heterodyne"].noise_lines(2.3e-9, 155.52e6)
            ],
            [
                (
                    "Shot noise of the local oscillator: sqrt(1 / 2) | quadrature of the field, in which the "
                    "signal is sqrt(q n); matched filter"
                ),
                (
                    "Background beat noise: sqrt(q N) | quadrature of the field, in which the signal is sqrt(q "
                    "n); matched filter"
                ),
            ],
        ),
        (
            lambda: [
                f"{line.name} ({line.unit}): {line.basis} | {line.regime}"
                for line in KINDS_UNLIKE["dpsk"].noise_lines(2.3e-9, 155.52e6)
            ],
            [
                (
                    "Signal-ASE beat noise (photon): sqrt(n N) | matched filter; product of the fields of two "
                    "symbols, so not Gaussian"
                ),
                (
                    "ASE-ASE beat noise (photon): N / sqrt 2 | matched filter; product of the fields of two "
                    "symbols, so not Gaussian"
                ),
            ],
        ),
        (
            lambda: [
                f"{line.name} ({line.unit}): {line.basis} | {line.regime}"
                for line in KINDS_UNLIKE["ppm"].noise_lines(2.3e-9, 155.52e6)
            ],
            [
                ("Signal shot noise, pulse (count): sqrt(mean counts in a slot) | Poisson counts, no dead time"),
                "Background shot noise (count): sqrt(mean counts in a slot) | Poisson counts, no dead time",
                "Dark counts (count): sqrt(mean counts in a slot) | Poisson counts, no dead time",
            ],
        ),
    ],
)
def test_noise_of_receivers_has_its_names_and_formulas(found, expected):
    assert found() == expected


@pytest.mark.parametrize(
    ("call", "error", "words"),
    [
        (
            lambda: KINDS_UNLIKE["ppm"].required_power_w([1e8, 0.9e9]),
            RateError,
            (
                "the data rate is 900 Mbit/s, which is 3.077 GHz of symbols or slots on the line: the "
                "receiver takes 2.7 GHz, so at most 789.7 Mbit/s of data"
            ),
        ),
        (
            lambda: KINDS_UNLIKE["amplified"].required_power_w(2.2e9),
            RateError,
            (
                "the data rate is 2.2 Gbit/s, which is 2.821 GHz of symbols or slots on the line: the "
                "receiver takes 2.7 GHz, so at most 2.106 Gbit/s of data"
            ),
        ),
        (
            lambda: replace(KINDS_UNLIKE["qpsk heterodyne"], phase_error_rad=0.31),
            ValueError,
            (
                "QpskHeterodyne.phase_error_rad is 0.31 rad: no power reaches a bit error ratio of 3e-07 "
                "above 0.157 rad rms"
            ),
        ),
        (
            lambda: replace(KINDS_UNLIKE["ppm"], order=12),
            ValueError,
            "the order of the pulse-position modulation is 12: it is a power of two above 1",
        ),
        (
            lambda: replace(KINDS_UNLIKE["ppm"], code_gap_db=1.5),
            ValueError,
            "code_gain_db stands beside code_gap_db: a code has one of both",
        ),
        (
            lambda: replace(KINDS_UNLIKE["apd"], ionisation_ratio=1.25),
            ValueError,
            (
                "OokApd.ionisation_ratio is 1.25: it must be finite, at least 0, at most 1; take the "
                "inverse when the other carrier starts the avalanche"
            ),
        ),
        (
            lambda: KINDS_UNLIKE["pin"].required_power_w(-1.5e8),
            ValueError,
            "the data rate is -150 Mbit/s: it must be finite, above 0 bit/s",
        ),
        (
            lambda: KINDS_UNLIKE["pin"].bit_error_ratio_at(-1.5e-9, 1e8),
            ValueError,
            "the received power is -1.5 nW: it must be finite, at least 0 W",
        ),
        (
            lambda: background_power_w(3.1e6, 0.023, 3.25, 2.3e-9),
            ValueError,
            (
                "the field of view is 3.25 rad: it must be finite, at least 0 rad, at most 3.142 rad; it "
                "is the full angle, up to pi rad (a half space)"
            ),
        ),
        (
            lambda: apd_excess_noise_factor(0.75, 0.23),
            ValueError,
            "the gain of the avalanche photodiode is 0.75: it must be finite, at least 1",
        ),
    ],
)
def test_a_refusal_of_a_receiver_says_its_numbers(call, error, words):
    with pytest.raises(error) as refused:
        call()
    assert str(refused.value) == words


PLAIN = {"wavelength_m": 8.1e-7, "bit_error_ratio": 2e-4, "bandwidth_hz": 3e9}
BARE = {
    "ook": OokCounting(**PLAIN, detection_efficiency=0.31),
    "ppm": PpmCounting(**PLAIN, detection_efficiency=0.31, order=64, dark_count_rate_hz=2e4),
    "gap": PpmCounting(
        **PLAIN, code_rate=0.4, detection_efficiency=0.31, order=64, dark_count_rate_hz=2e4, code_gap_db=0.8
    ),
    "amplified": OokPreamplified(**PLAIN, noise_figure_db=3.0, gain_db=20.0, optical_bandwidth_hz=9e9, code_rate=0.5),
    "pin": OokPin(**PLAIN, quantum_efficiency=0.6, thermal_noise_a_sqrt_hz=3e-12),
}


@pytest.mark.parametrize(("found", "expected"), [
    (lambda: BARE["ook"].bit_error_ratio_at([0.0, 1e-12, 4e-11], 2e6), "0.5 0.141251421 5.49392625e-23"),
    (lambda: BARE["ook"].required_power_w([3e3, 2e6]), "9.28437502e-15 6.18958335e-12"),
    (lambda: [BARE["ook"].photons_per_bit(2e6), BARE["ook"].net_gain_db(2e6), BARE["ook"].symbol_rate_hz(2e6)],
     "12.619429 0 2000000"),
    (lambda: replace(BARE["ook"], background_power_w=3e-4).required_power_w([2e6]), "7.71365125e-08"),
    (lambda: replace(BARE["ook"], background_power_w=3e-4).bit_error_ratio_at([1e-7, 1.4e-7], 2e6),
     "2.22473797e-06 6.61726196e-11"),
    (lambda: BARE["ppm"].bit_error_ratio_at([0.0, 2e-13, 3e-12], 1e6), "0.5 0.119294939 1.52749976e-10"),
    (lambda: BARE["ppm"].required_power_w([2e4, 3e6]), "2.80869236e-14 3.15263431e-12"),
    (lambda: [BARE["ppm"].photons_per_bit(1e6), BARE["ppm"].symbol_rate_hz(1e6), BARE["ppm"].highest_data_rate_bit_s],
     "4.41551808 10666666.7 281250000"),
    (lambda: [BARE["gap"].net_gain_db(1e6), BARE["gap"].required_power_w(1e6), BARE["gap"].bit_error_ratio_at(6e-13,
            1e6)],
     "6.95793808 2.18162234e-13 1.79538866e-10"),
    (lambda: BARE["gap"].net_gain_db([4e5, 2e6]), "6.87165193 6.99904927"),
    (lambda: replace(BARE["ppm"], background_power_w=7e-6).required_power_w([1e6]), "7.371098e-10"),
    (lambda: [BARE["amplified"].highest_data_rate_bit_s, replace(BARE["amplified"],
            optical_bandwidth_hz=4e9).highest_data_rate_bit_s],
     "1500000000 1500000000"),
    (lambda: BARE["amplified"].required_power_w([1e8, 6e8]), "1.47784863e-09 4.69683365e-09"),
    (lambda: BARE["amplified"].bit_error_ratio_at([0.0, 2e-9], 6e8), "0.5 0.0317394473"),
    (lambda: replace(BARE["pin"], thermal_noise_a_sqrt_hz=0.0).bit_error_ratio_at([0.0, 1e-9], 6e8),
     "0.5 0.00214681173"),
    (lambda: replace(BARE["pin"], thermal_noise_a_sqrt_hz=0.0).required_power_w([6e8]), "1.53669898e-09"),
    (lambda: [apd_excess_noise_factor(1.0, 0.3), apd_excess_noise_factor(40.0, 0.0), apd_excess_noise_factor(40.0,
            1.0)],
     "1 1.975 40"),
    (lambda: [background_power_w(3e6, 0.02, x, 2e-9) for x in (0.0, 1e-4, math.pi)], "0 9.42477795e-13 0.000376991118"),
    (lambda: [background_photons_per_mode(0.0, 1e-6), background_photons_per_mode(5e9, 1.31e-6)], "0 0.000161956749"),
    (lambda: [x.value for x in BARE["ppm"].noise_lines(1e-12, 1e6)], "2.75397894 0 0.0433012702"),
    (lambda: [x.value for x in BARE["ook"].noise_lines(1e-12, 1e6)], "1.59001048 0 0 0"),
    (lambda: [x.value for x in BARE["amplified"].noise_lines(1e-9, 1e8)],
     "2.89374015e-08 0 3.03146045e-08 2.04618329e-09 0 3.03991643e-09"),
    (lambda: [x.value for x in BARE["pin"].noise_lines(0.0, 1e8)], "0 0 0 0 2.12132034e-08"),
    (lambda: [x.value for x in KINDS_UNLIKE["dpsk"].noise_lines(3e-9, 1e8)], "13.5834835 1.04094208"),
    (lambda: [x.value for x in KINDS_UNLIKE["bpsk homodyne"].noise_lines(3e-9, 1e8)], "0.5 0.0877781294"),
])  # fmt: skip
def test_receivers_at_their_edges_have_these_numbers(found, expected):
    assert list(found()) == pytest.approx([float(each) for each in expected.split()], rel=1e-6, abs=0.0, nan_ok=True)


@pytest.mark.parametrize(("found", "expected"), [
    (lambda: "; ".join(f"{x.name}: {x.basis}, {x.unit}, {x.regime}" for x in BARE["pin"].noise_lines(1e-9, 1e8)),
     "Signal shot noise, marks: sqrt(2 e M^2 F R P B), A, Gaussian noise in 0.5 of the symbol rate; Signal shot "
     "noise, spaces: sqrt(2 e M^2 F R P B), A, Gaussian noise in 0.5 of the symbol rate; Background shot noise: "
     "sqrt(2 e M^2 F R P B), A, Gaussian noise in 0.5 of the symbol rate; Dark current shot noise: sqrt(2 e M^2 "
     "F I B), A, Gaussian noise in 0.5 of the symbol rate; Thermal noise: density sqrt(B), A, Gaussian noise in "
     "0.5 of the symbol rate"),
    (lambda: "; ".join(f"{x.name}: {x.basis}, {x.unit}" for x in BARE["ook"].noise_lines(1e-9, 1e8)),
     "Signal shot noise, marks: sqrt(mean counts in a slot), count; Signal shot noise, spaces: sqrt(mean counts "
     "in a slot), count; Background shot noise: sqrt(mean counts in a slot), count; Dark counts: sqrt(mean "
     "counts in a slot), count"),
    (lambda: "; ".join(f"{x.name}: {x.basis}, {x.unit}" for x in BARE["amplified"].noise_lines(1e-9, 1e8)),
     "Signal-ASE beat noise, marks: sqrt(4 I S B), S in A/Hz, A; Signal-ASE beat noise, spaces: sqrt(4 I S B), S "
     "in A/Hz, A; ASE-ASE beat noise: sqrt(2 p S^2 B (Bo - B/2)), S in A/Hz, A; Signal shot noise, marks: sqrt(2 "
     "e I B), A; Signal shot noise, spaces: sqrt(2 e I B), A; ASE shot noise: sqrt(2 e p S Bo B), S in A/Hz, A"),
    (lambda: "; ".join(f"{x.name}: {x.basis}, {x.regime}" for x in KINDS_UNLIKE["qpsk homodyne"].noise_lines(1e-9,
            1e8)),
     "Shot noise of the local oscillator: 1/2, quadrature of the field, in which the signal is sqrt(q n / 4); "
     "matched filter; Background beat noise: sqrt(q N / 4), quadrature of the field, in which the signal is "
     "sqrt(q n / 4); matched filter"),
])  # fmt: skip
def test_receivers_without_anything_more_name_the_terms_of_their_noise(found, expected):
    assert found() == expected


@pytest.mark.parametrize(("found", "expected"), [
    (lambda: replace(BARE["ppm"], order=0),
     "the order of the pulse-position modulation is 0: it is a power of two above 1"),
    (lambda: replace(BARE["ppm"], order=1),
     "the order of the pulse-position modulation is 1: it is a power of two above 1"),
    (lambda: replace(BARE["amplified"], gain_db=9.5),
     "OokPreamplified.gain_db is 9.5 dB: it must be finite, at least 10 dB; high gain is meant"),
    (lambda: replace(BARE["amplified"], noise_figure_db=2.9),
     "OokPreamplified.noise_figure_db is 2.9 dB: it must be finite, at least 3 dB; 3 dB is the quantum limit of "
     "an amplifier of both quadratures at high gain"),
    (lambda: replace(BARE["amplified"], polarisations=3),
     "OokPreamplified.polarisations is 3: it must be finite, at least 1, at most 2"),
    (lambda: replace(BARE["ook"], extinction_ratio=1.0),
     "OokCounting.extinction_ratio is 1: it must be finite, above 1; the power of a mark over that of a space "
     "(inf: dark spaces)"),
    (lambda: replace(BARE["ook"], bit_error_ratio=0.5),
     "OokCounting.bit_error_ratio is 0.5: it must be finite, at least 1e-18 and below 0.5; 0.5 is a guess"),
    (lambda: replace(BARE["ook"], bit_error_ratio=9e-19),
     "OokCounting.bit_error_ratio is 9e-19: it must be finite, at least 1e-18 and below 0.5; 0.5 is a guess"),
    (lambda: replace(BARE["ook"], code_rate=0.0), "OokCounting.code_rate is 0: it must be finite, above 0, at most 1"),
    (lambda: replace(BARE["ook"], code_gain_db=-0.1),
     "OokCounting.code_gain_db is -0.1 dB: it must be finite, at least 0 dB; a code that costs power is better "
     "left out"),
    (lambda: replace(BARE["pin"], quantum_efficiency=1.01),
     "OokPin.quantum_efficiency is 1.01: it must be finite, above 0, at most 1; one count or electron for each "
     "photon at the most"),
    (lambda: replace(BARE["gap"], code_gap_db=-0.5),
     "PpmCounting.code_gap_db is -0.5 dB: it must be finite, at least 0 dB; no code does with less than capacity"),
    (lambda: BARE["gap"].required_power_w(1e9),
     "the data rate is 1 Gbit/s, which is 26.67 GHz of symbols or slots on the line: the receiver takes 3 GHz, "
     "so at most 112.5 Mbit/s of data"),
    (lambda: BARE["pin"].noise_lines(-1e-9, 1e8), "the received power is -1 nW: it must be finite, at least 0 W"),
    (lambda: BARE["pin"].noise_lines(1e-9, 0.0), "the data rate is 0 bit/s: it must be finite, above 0 bit/s"),
    (lambda: background_photons_per_mode(-1.0, 1e-6),
     "the spectral radiance is -1 W/(m^2 sr m): it must be finite, at least 0 W/(m^2 sr m)"),
    (lambda: background_power_w(1.0, 1.0, -0.1, 1.0),
     "the field of view is -100 mrad: it must be finite, at least 0 rad, at most 3.142 rad; it is the full "
     "angle, up to pi rad (a half space)"),
    (lambda: apd_excess_noise_factor(2.0, -0.1),
     "the ionisation ratio is -0.1: it must be finite, at least 0, at most 1; take the inverse when the other "
     "carrier starts the avalanche"),
    (lambda: replace(KINDS_UNLIKE["dpsk"], background_photons_per_mode=-0.1),
     "DpskPreamplified.background_photons_per_mode is -0.1 photon: it must be finite, at least 0 photon"),
    (lambda: replace(KINDS_UNLIKE["bpsk homodyne"], phase_error_rad=9.0),
     "BpskHomodyne.phase_error_rad is 9 rad: it must be finite, at least 0 rad, at most 1 rad"),
])  # fmt: skip
def test_a_refusal_of_a_bare_receiver_is_one_whole_sentence(found, expected):
    with pytest.raises((ValueError, ArithmeticError)) as refused:
        found()
    assert str(refused.value) == expected


def test_the_data_rate_that_is_told_as_the_most_is_taken():
    narrow = replace(PIN, bandwidth_hz=1.23456e9)
    said = "is 1.235 GHz of symbols or slots on the line: the receiver takes 1.234 GHz, so at most 1.234 Gbit/s of data"
    with pytest.raises(RateError, match=said):
        narrow.required_power_w(1.235e9)
    assert np.isfinite(narrow.required_power_w(1.234e9))


@pytest.mark.parametrize(("ratio", "shown"), [(3e-7, "3e-07"), (1e-7 / 3.0, "3.33333e-08")])
def test_a_refusal_of_a_phase_error_has_six_digits_of_numbers_that_have_more(ratio, shown):
    with pytest.raises(ValueError) as refused:
        replace(KINDS_UNLIKE["qpsk heterodyne"], phase_error_rad=1.0 / 3.0, bit_error_ratio=ratio)
    said = str(refused.value)
    start = f"QpskHeterodyne.phase_error_rad is 0.333333 rad: no power reaches a bit error ratio of {shown} above "
    assert said.startswith(start) and said.endswith(" rad rms")
    assert 0.05 < float(said.removeprefix(start).split()[0]) < 0.2


@pytest.mark.parametrize("order", [2, 4, 1024])
def test_a_symbol_of_two_slots_is_the_shortest(order):
    assert replace(PPM, order=order).order == order


@pytest.mark.parametrize("order", [1, 0, 0.5, 3, 2.5, 1023])
def test_an_order_that_is_no_power_of_two_above_one_is_refused(order):
    with pytest.raises(ValueError, match=f"PpmCounting.order is {order:g}:|modulation is {order:g}: it is a power of"):
        replace(PPM, order=order)


@pytest.mark.parametrize("order", [2, 16, 64])
@pytest.mark.parametrize("rates", [(1e9, 1e6, 3e4, 2e7), (3e4, 1e9, 1e6)])
def test_rates_of_much_and_of_little_background_in_any_order_are_each_as_alone(order, rates):
    """The counts of background in a slot go from a hundredth to hundreds, so that their tables end elsewhere."""
    receiver = replace(NOISY_PPM, order=order)
    alone = [float(receiver.required_power_w(rate)) for rate in rates]
    assert_allclose(receiver.required_power_w(rates), alone, rtol=1e-9)
    powers = np.array(alone) * np.linspace(0.5, 1.2, len(rates))
    found = [float(receiver.bit_error_ratio_at(power, rate)) for power, rate in zip(powers, rates, strict=True)]
    assert_allclose(receiver.bit_error_ratio_at(powers, rates), found, rtol=1e-9)


@pytest.mark.parametrize("rates", [(1e9, 3e9, 2.5e9), (3e9, 1e9), (0.5e9, 1e9, 3e9), ((1e9, 3e9), (2.5e9, 1e9))])
def test_of_several_rates_the_highest_is_refused_wherever_it_stands(rates):
    coded = replace(PIN, bandwidth_hz=4e9, code_rate=0.5)
    with pytest.raises(RateError) as refused:
        coded.required_power_w(rates)
    assert str(refused.value) == (
        "the data rate is 3 Gbit/s, which is 6 GHz of symbols or slots on the line: the receiver takes 4 GHz, so at "
        "most 2 Gbit/s of data"
    )


def test_a_gap_to_capacity_is_that_of_each_rate_in_whatever_order_they_stand():
    coded = replace(NOISY_PPM, code_gap_db=1.5, code_rate=0.5)
    rates = np.array([[3e6, 2e7], [1e9, 1e6]])
    found = coded.required_power_w(rates)
    assert found.shape == rates.shape
    assert_allclose(found.ravel(), [float(coded.required_power_w(rate)) for rate in rates.ravel()], rtol=1e-9)
