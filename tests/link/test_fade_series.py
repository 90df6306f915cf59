"""Coded error rate over series of received power: against bit-true simulations of the same, and what is refused."""

import hashlib
import math
from dataclasses import replace
from itertools import pairwise

import h5py
import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.optimize import brentq

import viterbi
from microrad.core.intervals import student
from microrad.link.fade_series import (
    CodedLink,
    FadeSeries,
    FadeSeriesError,
    Threshold,
    code,
    coded_fading,
    read_fade_series,
    reader,
)
from microrad.link.fade_series import coded as coded_module
from microrad.link.fade_series.coded import cost
from microrad.link.fade_series.codes import mutual_information
from microrad.link.fade_series.records import part
from microrad.mission.codes import codes

CODE = code("ccsds-k7-1-2")
PERIOD_S, BITS = 1e-5, 512  # of a sample, and bits of information in one
RATE = BITS / PERIOD_S


def slow(samples, length, seed):
    """A smooth Gaussian process of mean 0 and deviation 1 whose fades are about so many samples long."""
    freq = np.fft.rfftfreq(samples)
    white = np.fft.rfft(np.random.default_rng(seed).standard_normal(samples))
    x = np.fft.irfft(white * np.exp(-((freq * length * math.pi) ** 2)), samples)
    return (x - x.mean()) / x.std()


def scintillation(samples, length, seed, deviation=0.5):
    return np.exp(deviation * slow(samples, length, seed))


def beam(samples, length, seed, jitter=0.4):
    """A Gaussian beam that jitters about both axes, by so many half angles."""
    return np.exp(-2.0 * jitter**2 * (slow(samples, length, seed) ** 2 + slow(samples, length, seed + 50) ** 2))


def rayleigh(samples, length, seed):
    return slow(samples, length, seed) ** 2 + slow(samples, length, seed + 50) ** 2


def series_of(power, **others):
    named = {"unit": "linear", "normalised": "mean", **others}
    return FadeSeries.of(power, PERIOD_S, "series", **named)


def linked(series, span=0, kind="block", coded=CODE, rate=RATE):
    return CodedLink(coded, series, rate, kind if span else "none", span * PERIOD_S)


def within_a_tenth(series, snr_db, span, runs, least=300):
    """Whether the simulated error ratio is one that 0.1 dB more or less of power explains; over whole blocks."""
    whole = part(series, 0, series.power.size // max(span, 1) * max(span, 1))
    power, words = np.repeat(whole.power, 2 * BITS), whole.power.size // 4
    wrong = bits = 0
    for run in range(runs):
        order = None
        if span:
            order = viterbi.block_order(power.size, span * 2 * BITS, (run, 2))
        found = viterbi.wrong_bits(power, 10.0 ** (snr_db / 10.0), (run, 1), words, order)
        wrong, bits = wrong + int(found.sum()), bits + found.size
    assert wrong >= least
    link = linked(series, span)
    more, less = (link.mean_ratio(10.0 ** ((snr_db + each) / 10.0)) for each in (0.1, -0.1))
    assert more < wrong / bits < less, (more, wrong / bits, less)
    return wrong / bits


def steps(samples, dark, seed):
    """Powers of which so many are 16 dB below the others, at random."""
    return np.where(np.random.default_rng(seed).random(samples) < dark, 0.025, 1.0)


SLOW, FAST = scintillation(1024, 30, 1), beam(1024, 4, 3)


@pytest.mark.promise("link-87")
@pytest.mark.parametrize(
    ("power", "snr_db", "span", "runs"),
    [
        (np.ones(1024), -0.4, 0, 1),
        pytest.param(SLOW, 2.5, 0, 2, marks=pytest.mark.endurance),
        pytest.param(SLOW, 2.3, 8, 2, marks=pytest.mark.endurance),  # below the fades
        (SLOW, 2.0, 32, 2),  # about as long as they are
        pytest.param(SLOW, 1.3, 256, 2, marks=pytest.mark.endurance),  # above them
        (FAST, 0.3, 64, 1),
        pytest.param(FAST, 0.0, 1024, 2, marks=pytest.mark.endurance),
    ],
)
def test_the_error_ratio_is_that_of_a_bit_true_simulation_over_the_same_series(power, snr_db, span, runs):
    assert 2e-4 < within_a_tenth(series_of(power), snr_db, span, runs) < 4e-3


@pytest.mark.promise("link-87")
@pytest.mark.parametrize(
    ("power", "snr_db", "span"),
    [
        pytest.param(steps(1024, 0.4, 2), 0.0, 1024, marks=pytest.mark.endurance),
        pytest.param(rayleigh(1024, 60, 2), 5.0, 100, marks=pytest.mark.endurance),
        (rayleigh(1024, 60, 2), 6.0, 30),
    ],
)
def test_and_it_is_where_a_window_leaves_many_errors(power, snr_db, span):
    """There the mutual information counts: without it 0.3 dB would be missed."""
    assert 0.01 < within_a_tenth(series_of(power), snr_db, span, 1) < 0.1


@pytest.mark.promise("link-87")
def test_nearest_paths_over_exponential_powers_are_mistaken_as_with_so_many_receivers():
    """Of ten independent exponential powers, added: Proakis, Digital Communications, equation 14-4-15."""
    alone = replace(CODE, share=(0.0,) * len(CODE.share))
    for snr in (0.5, 1.0, 2.0):
        wrong = (1.0 - math.sqrt(snr / (1.0 + snr))) / 2.0
        pairs = wrong**10 * sum(math.comb(9 + k, k) * (1.0 - wrong) ** k for k in range(10))
        like = brentq(lambda each, pairs=pairs: math.log(0.5 * math.erfc(math.sqrt(10.0 * each)) / pairs), 0.01, 10.0)
        quantiles = -np.log((np.arange(200_000) + 0.5) / 200_000)
        means = [each.mean(keepdims=True) for each in alone.parts(snr * quantiles)]
        assert float(alone.ratio(means)[0]) == pytest.approx(float(CODE.at(like)), rel=0.01, abs=0.0)


@pytest.mark.promise("link-85")
@pytest.mark.parametrize("kind", ["block", "convolutional"])
def test_windows_are_those_of_their_interleaver(kind):
    series, at = series_of(SLOW), {"block": range(0, 1017, 8), "convolutional": range(1017)}
    parts = CODE.parts(1.6 * series.power)
    means = [np.array([each[k : k + 8].mean() for k in at[kind]]) for each in parts]
    assert_allclose(linked(series, 8, kind).ratios(1.6), CODE.ratio(means), rtol=1e-6)


@pytest.mark.promise("link-87")
@pytest.mark.endurance
@pytest.mark.parametrize(
    ("power", "snr_db", "span", "runs"),
    [
        (np.ones(1024), 0.45, 0, 40),
        (SLOW, 4.0, 0, 40),
        (SLOW, 4.5, 0, 60),
        (SLOW, 4.0, 8, 40),
        (SLOW, 3.2, 32, 40),
        (SLOW, 2.6, 64, 40),
        (SLOW, 1.5, 256, 40),
        (SLOW, 1.3, 1024, 40),
        (FAST, 15.4, 0, 10),
        (FAST, 1.6, 32, 40),
        (FAST, 1.2, 256, 40),
        (beam(1024, 30, 3), 6.0, 0, 40),
        (beam(1024, 30, 3), 5.7, 32, 20),
        (beam(1024, 30, 3), 2.5, 128, 40),
        (beam(1024, 30, 3), 1.2, 1024, 40),
        (scintillation(1024, 30, 2, 0.9), 10.2, 0, 20),
        (scintillation(1024, 30, 2, 0.9), 9.1, 32, 20),
        (scintillation(1024, 30, 2, 0.9), 3.0, 1024, 40),
    ],
)
def test_and_so_it_is_where_errors_are_rare(power, snr_db, span, runs):
    ratio = within_a_tenth(series_of(power), snr_db, span, runs)
    assert 3e-6 < ratio < 2e-3


@pytest.mark.promise("link-87")
def test_at_constant_power_the_code_has_the_published_gain_and_the_union_bound_above_it():
    """4.2 dB of Eb/N0 at 1e-5 with eight levels of soft decision, CCSDS 130.1-G; as many as one likes gain a tenth."""
    needed_db = 10.0 * math.log10(CODE.snr_for(1e-5) / CODE.rate)
    assert 4.05 < needed_db < 4.2
    for db in (0.0, 0.5, 1.0, 2.0):
        snr = 10.0 ** (db / 10.0)
        bound = sum(w * 0.5 * math.erfc(math.sqrt(d * snr)) for d, w in zip(CODE.distances, CODE.weights, strict=True))
        assert 0.6 * bound < float(CODE.at(snr)) < bound
    assert float(CODE.at(1e-6)) == pytest.approx(0.5, rel=1e-3, abs=0.0)
    levels = np.linspace(-20.0, 8.0, 300)
    assert np.all(np.diff(CODE.at(10.0 ** (levels / 10.0))) < 0.0)
    assert_allclose(CODE.ratio(CODE.parts(10.0 ** (levels / 10.0))), CODE.at(10.0 ** (levels / 10.0)), rtol=2e-3)


def test_the_distances_are_those_of_the_trellis():
    """All paths from the state 0 back to it, counted by the weight of their symbols and by their ones."""
    front, weights = {(32, sum(s < 0 for s in viterbi.signs(64))): (1, 1)}, {}
    while front:
        later = {}
        for (state, distance), (paths, ones) in front.items():
            for bit in (0, 1):
                register = state | bit << 6
                at = (register >> 1, distance + sum(s < 0 for s in viterbi.signs(register)))
                if at[1] > 18:
                    continue
                more = ones + bit * paths
                if at[0] == 0:
                    weights[at[1]] = weights.get(at[1], 0) + more
                else:
                    p, o = later.get(at, (0, 0))
                    later[at] = p + paths, o + more
        front = later
    assert sorted(weights.items()) == list(zip(CODE.distances, CODE.weights, strict=True))


def test_the_mutual_information_is_that_of_a_quadrature():
    x, w = np.polynomial.hermite_e.hermegauss(80)
    for snr in (0.05, 0.3, 1.0, 3.0):
        log = np.log2(1.0 + np.exp(-4.0 * snr - 2.0 * math.sqrt(2.0 * snr) * x))
        exact = 1.0 - np.sum(w * log) / np.sum(w)
        assert float(mutual_information(np.array(snr))) == pytest.approx(exact, rel=0.0, abs=1.5e-3)


@pytest.mark.promise("link-87")
def test_without_an_interleaver_the_mean_is_that_over_all_times_and_with_a_long_one_that_of_the_mixture():
    series = series_of(SLOW)
    alone = linked(series).mean_ratio(1.6)
    assert alone == pytest.approx(float(np.mean(CODE.at(1.6 * series.power))), rel=2e-3, abs=0.0)
    shuffled = series_of(np.random.default_rng(1).permutation(SLOW))
    assert linked(shuffled).mean_ratio(1.6) == pytest.approx(alone, rel=1e-9, abs=0.0)
    both = linked(series, 1024).mean_ratio(1.6), linked(shuffled, 1024).mean_ratio(1.6)
    assert both[0] == pytest.approx(both[1], rel=1e-9, abs=0.0)
    assert 0.0 < both[0] < 0.2 * alone
    sliding = linked(series, 1000, "convolutional").mean_ratio(1.6)
    assert 0.5 * both[0] < sliding < 2.0 * both[0]


@pytest.mark.promise("link-86")
def test_constant_power_costs_nothing_and_fades_cost_less_the_longer_the_interleaver():
    found = coded_fading(linked(series_of(np.ones(1024)), 16), 1.0, 1e-5)
    assert found.penalty_db == pytest.approx(0.0, abs=2e-3)
    assert found.ratio.value < 1e-5
    assert (found.lost.value, found.fades.share) == (0.0, 0.0)
    assert np.allclose(found.curve.penalty_db, 0.0, atol=2e-3)
    faded = coded_fading(linked(series_of(scintillation(1 << 14, 30, 7)), 64), 3.0, 1e-5)
    costs = faded.curve.penalty_db
    assert faded.curve.span_s[0] == 0.0
    assert costs[0] > faded.penalty_db > costs[-1] > 0.3
    assert all(b < a + 0.05 for a, b in pairwise(costs))
    assert faded.margin_left_db == faded.margin_db - faded.penalty_db < 0.0
    assert faded.ratio.low < faded.ratio.value < faded.ratio.high
    assert faded.ratio.value > 1e-5
    assert 0.0 < faded.lost.low < faded.lost.value < faded.lost.high < 0.5


@pytest.mark.promise("link-86")
def test_the_penalty_brings_the_mean_back_and_no_power_makes_up_for_darkness():
    series = series_of(SLOW)
    link = linked(series, 32)
    penalty = link.penalty_db(1e-6)
    snr = CODE.snr_for(1e-6) * 10.0 ** (penalty / 10.0)
    assert link.mean_ratio(snr * 1.0005) < 1e-6 < link.mean_ratio(snr / 1.0005)
    dark = np.ones(1024)
    dark[100:140] = 0.0
    assert linked(series_of(dark)).penalty_db(1e-6) == math.inf
    assert linked(series_of(dark), 512).penalty_db(1e-6) < 2.0


def test_what_the_fades_cost_is_found_once_for_all_rates_whose_words_are_as_many_samples():
    series = series_of(SLOW)
    found = cost(linked(series, 32), 1e-6)
    assert cost(linked(series, 32, rate=3.0 * RATE), 1e-6) is found
    assert cost(linked(series, 64), 1e-6) is not found
    long = linked(series, rate=35.0 / (20.4 * PERIOD_S))
    assert long.window == 20
    assert cost(long, 1e-6)[0] == long.penalty_db(1e-6)
    assert cost(linked(series), 1e-6)[0] == linked(series).penalty_db(1e-6) > found[0]


def test_a_block_code_is_lost_where_its_words_hold_too_little():
    """A word over ten samples of which some are dark: it needs the mean of the mutual information, counted by hand."""
    power = np.ones(1000)
    power[np.arange(1000) // 10 % 4 == 0] = 0.2
    block = Threshold("a block code", 0.5, 10 * BITS, threshold_snr=0.5)
    link = linked(series_of(power, normalised="as-given"), coded=block)
    told = mutual_information(np.array([0.2, 1.0]) * 0.8), mutual_information(np.array(0.5))
    assert told[0][0] < told[1] < told[0][1]
    assert link.window == 10
    assert link.mean_ratio(0.8) == 0.25
    assert link.mean_ratio(2.6) == 0.0
    assert link.penalty_db(0.1) == pytest.approx(10.0 * math.log10(5.0), abs=2e-3)
    assert linked(series_of(power, normalised="as-given"), 40, coded=block).mean_ratio(0.8) == 0.0


@pytest.mark.promise("link-86")
def test_fades_are_counted_by_hand():
    power = np.ones(1000)
    for first, length in ((0, 3), (100, 1), (200, 4), (300, 10), (995, 5)):
        power[first : first + length] = 0.1
    found = series_of(power, normalised="largest").fades(0.5)
    assert found.share == pytest.approx(0.023, rel=1e-12, abs=0.0)
    assert found.per_second == pytest.approx(4 / 0.01, rel=1e-12, abs=0.0)
    assert_allclose([found.mean_s, found.median_s, found.longest_s], [5e-5, 4e-5, 10e-5], rtol=1e-12)
    assert found.unresolved == pytest.approx(1 / 23, rel=1e-12, abs=0.0)
    assert math.isnan(series_of(np.ones(1000)).fades(0.5).mean_s)


@pytest.mark.promise("link-86")
def test_the_intervals_are_those_of_sixteen_parts():
    """By Student's t with fifteen degrees of freedom: 2.947 deviations of the mean to either side for 99 %."""
    series = series_of(scintillation(1 << 14, 30, 7))
    link = linked(series, 64)
    found = coded_fading(link, 3.0, 1e-5)
    ratios = link.ratios(CODE.snr_for(1e-5) * 10.0**0.3)
    parts = ratios.reshape(16, -1).mean(axis=1)
    half = 2.9467 * np.std(parts, ddof=1) / 4.0
    assert found.words == ratios.size
    assert found.ratio.value == pytest.approx(np.mean(ratios), rel=1e-9, abs=0.0)
    assert found.ratio.high == pytest.approx(np.mean(ratios) + half, rel=1e-4, abs=0.0)
    assert found.ratio.low == pytest.approx(max(np.mean(ratios) - half, 0.0), rel=1e-4, abs=0.0)
    assert found.lost.value == pytest.approx(np.mean(ratios > 1e-5), rel=1e-9, abs=0.0)
    assert found.lost.low < found.lost.value < found.lost.high


@pytest.mark.promise("link-85")
def test_levels_and_normalisations():
    levels = 10.0 * np.log10(SLOW)
    assert_allclose(series_of(levels, unit="dB").power, series_of(SLOW).power, rtol=1e-12)
    assert series_of(SLOW).power.mean() == pytest.approx(1.0, rel=1e-12, abs=0.0)
    assert series_of(SLOW, normalised="largest").power.max() == 1.0
    assert_allclose(series_of(SLOW, normalised="as-given").power, SLOW, rtol=1e-15)
    with pytest.raises(ValueError, match="read-only"):
        series_of(SLOW).power[0] = 1.0


@pytest.mark.promise("link-88")
@pytest.mark.parametrize(
    ("power", "others", "words"),
    [
        (np.ones(100), {}, "the series has 100 samples; from 200 to 2000000 are taken"),
        (np.ones((300, 2)), {}, r"have the shape \(300, 2\); give one series"),
        (
            np.r_[np.ones(300), -0.1],
            {},
            'sample 300 is -0.1, 1 such sample .* \\(unit "dB" if these are levels\\)',
        ),
        (np.r_[np.ones(300), np.nan], {}, "sample 300 is nan, .* finite, 0 or above and at most"),
        (np.r_[np.ones(300), 1e31], {}, r"sample 300 is 1e\+31, .* at most 1e\+30"),
        (np.r_[np.ones(300), 400.0], {"unit": "dB"}, "sample 300 is 400, .* a number up to 300 dB"),
        (np.zeros(300), {}, "no sample is above 0: there is no light"),
        (np.full(300, -np.inf), {"unit": "dB"}, "no sample is above 0: there is no light"),
        (np.ones(300), {"unit": "W"}, "the unit is 'W'; give one of linear, dB"),
        (np.ones(300), {"normalised": "peak"}, "the normalisation is 'peak'; give one of mean, largest, as-given"),
    ],
)
def test_a_series_that_is_none_is_refused(power, others, words):
    with pytest.raises(FadeSeriesError, match=f"^series: .*{words}"):
        series_of(power, **others)


@pytest.mark.promise("link-88")
def test_a_series_is_refused_that_is_shorter_than_a_word_or_an_interleaver_or_sampled_slower_than_its_fades():
    series = series_of(SLOW)
    with pytest.raises(FadeSeriesError, match=r"lasts 10\.24 ms and a code word, 35 bits, lasts 35 ms; give a series"):
        linked(series, rate=1000.0)
    assert linked(series, rate=3500.0).window == 1000
    with pytest.raises(FadeSeriesError, match=r"lasts 10\.24 ms and the interleaver spans 10\.25 ms"):
        linked(series, 1025)
    with pytest.raises(FadeSeriesError, match="interleaving is 'block' and its span 0 s"):
        CodedLink(CODE, series, RATE, "block")
    with pytest.raises(FadeSeriesError, match="the interleaving is 'blocks'; give one of none, block"):
        CodedLink(CODE, series, RATE, "blocks", 1e-3)
    for span_s, shown in ((-1e-3, "-1 ms"), (math.nan, "nan s"), (math.inf, "inf s")):
        with pytest.raises(FadeSeriesError, match=f"^series: the span of the interleaver is {shown}: it must"):
            CodedLink(CODE, series, RATE, "block", span_s)
    for rate in (0.0, -5.0, math.nan):
        with pytest.raises(FadeSeriesError, match=r"^series: the data rate is .*: it must be finite, above 0 bit/s"):
            linked(series, rate=rate)
    for target in (0.0, -1e-6, 2.0, math.nan):
        with pytest.raises(FadeSeriesError, match=r"^series: the error ratio is .*: it must be finite, above 0, at"):
            coded_fading(linked(series), 3.0, target)
    coded_fading(linked(series), 3.0, 1e-6)
    coarse = series_of(scintillation(1024, 0.1, 1))
    words = r"sampled slower than its fades: (9\d|100) % of the time below -.* in fades of a single sample, 10 µs, and"
    with pytest.raises(FadeSeriesError, match=words):
        coded_fading(linked(coarse), 3.0, 1e-6)


def test_a_code_of_another_name_is_none():
    with pytest.raises(ValueError, match='no code is called "ccsds"; there is ccsds-k7-1-2'):
        code("ccsds")


def test_a_short_file_without_times_is_told_that_it_is_short(tmp_path):
    path = tmp_path / "short.csv"
    path.write_text("power\n" + "1\n" * 199)
    with pytest.raises(FadeSeriesError, match="the series has 199 samples; from 200"):
        read_fade_series(path, unit="linear", normalised="mean")


@pytest.mark.promise("link-88")
@pytest.mark.parametrize(("alone", "refused"), [(10, False), (12, True)])
def test_a_tenth_of_the_faded_time_may_be_in_fades_of_a_single_sample(alone, refused):
    power = np.ones(2000)
    power[100:190] = 0.05
    power[300 : 300 + 20 * alone : 20] = 0.05
    link = linked(series_of(power, normalised="largest"), 100)
    if refused:
        with pytest.raises(FadeSeriesError, match=r"11\.8 % of the time below .* at most 10 % may be"):
            coded_fading(link, 3.0, 1e-6)
    else:
        assert coded_fading(link, 3.0, 1e-6).fades.unresolved == pytest.approx(0.1, rel=1e-12, abs=0.0)


@pytest.mark.promise("link-88")
def test_a_series_of_two_million_samples_is_taken_and_a_longer_one_is_not():
    assert series_of(np.ones(2_000_000)).power.size == 2_000_000
    assert series_of(np.ones(200)).power.size == 200
    for samples, advice in ((199, "give a longer one"), (2_000_001, "cut out a part")):
        words = f"the series has {samples} samples; from 200 to 2000000 are taken: {advice}"
        with pytest.raises(FadeSeriesError, match=words):
            series_of(np.ones(samples))


@pytest.mark.promise("link-85")
@pytest.mark.parametrize("kind", ["csv", "times.csv", "npy", "h5"])
def test_series_of_files_are_those_that_were_written(tmp_path, kind):
    path = tmp_path / f"fades.{kind}"
    given = {"period_s": PERIOD_S}
    if kind == "csv":
        path.write_text("power\n" + "\n".join(f"{x:.12g}" for x in SLOW) + "\n")
    elif kind == "times.csv":
        rows = (f"{k * PERIOD_S:.9g},{x:.12g}" for k, x in enumerate(SLOW))
        path.write_text("time (s),power\n" + "\n".join(rows) + "\n")
        given = {}
    elif kind == "npy":
        np.save(path, SLOW)
    else:
        with h5py.File(path, "w") as file:
            file["received/power"] = SLOW
            file["received/dt"] = PERIOD_S
        given = {}
    found = read_fade_series(path, unit="linear", normalised="as-given", **given)
    assert_allclose(found.power, SLOW, rtol=1e-11)
    assert found.period_s == pytest.approx(PERIOD_S, rel=1e-9, abs=0.0)
    assert found.source == str(path)
    assert len(found.sha256) == 64
    if given:
        with pytest.raises(FadeSeriesError, match="does not say how fast it was sampled; give the time between two"):
            read_fade_series(path, unit="linear", normalised="mean")
    else:
        with pytest.raises(FadeSeriesError, match="two sample rates"):
            read_fade_series(path, unit="linear", normalised="mean", period_s=2 * PERIOD_S)


@pytest.mark.promise("link-88")
def test_files_that_are_no_series_are_refused(tmp_path):
    def refused(name, words, text=None, **others):
        path = tmp_path / name
        if text is not None:
            path.write_text(text)
        with pytest.raises(FadeSeriesError, match=words):
            read_fade_series(path, **{"unit": "linear", "normalised": "mean", "period_s": 1e-3, **others})

    refused("absent.csv", "there is no such file")
    refused("empty.csv", "the file is empty", "")
    refused("two.csv", "the file has 2 channels beside its time", "a,b\n" + "1,2\n" * 300)
    refused("short.csv", "the series has 50 samples", "power\n" + "1\n" * 50)
    refused("unit.csv", "the powers are in dB, and the unit given is 'linear'", "power (dB)\n" + "1\n" * 300)
    times = [k * 1e-3 for k in range(300)]
    times[150:] = [each + 5e-3 for each in times[150:]]
    uneven = "time (s),power\n" + "".join(f"{t:.4f},1\n" for t in times)
    refused("uneven.csv", "1 gap, about 5 samples lost", uneven, period_s=None)
    np.save(tmp_path / "wide.npy", np.ones((300, 3)))
    refused("wide.npy", "the file has 3 channels beside its time")
    large = tmp_path / "large.csv"
    with large.open("wb") as file:
        file.truncate(200_000_001)
    refused("large.csv", "the file has 200.1 MB and at most 200 MB are read")


def test_the_code_has_the_paths_that_its_threshold_follows_from():
    """The distance spectrum stands in two files: with the simulated table, and among the codes by name."""
    own, named = code("ccsds-k7-1-2"), codes()["ccsds-k7-1-2"]
    assert [*zip(own.distances, own.weights, strict=True)][: len(named.weights)] == [*named.weights]
    assert own.rate == named.rate
    assert own.word_bits == 5 * 7  # what a decoder looks back, in bits of information


def test_a_file_of_200_samples_without_times_is_told_that_they_are_missing(tmp_path):
    path = tmp_path / "long_enough.csv"
    path.write_text("power\n" + "1\n" * 200)
    with pytest.raises(FadeSeriesError, match=r"long_enough\.csv: the file does not say how fast it was sampled"):
        read_fade_series(path, unit="linear", normalised="mean")


@pytest.mark.parametrize(("spare", "taken"), [(0, True), (-1, False)])
def test_a_file_of_the_largest_size_is_read(tmp_path, monkeypatch, spare, taken):
    path = tmp_path / "a.csv"
    path.write_text("power\n" + "1\n" * 200)
    monkeypatch.setattr(reader, "MOST_BYTES", path.stat().st_size + spare)
    given = {"unit": "linear", "normalised": "mean", "period_s": 1e-3, "name": "the fades"}
    if taken:
        assert read_fade_series(path, **given).source == "the fades"
    else:
        with pytest.raises(FadeSeriesError, match=r"^the fades: the file has 406 B"):
            read_fade_series(path, **given)


@pytest.mark.parametrize("unit", ["db", "dB", "DBM"])
def test_levels_of_a_file_are_levels_however_it_writes_them(tmp_path, unit):
    path = tmp_path / "a.csv"
    path.write_text(f"power ({unit})\n" + "0\n-10\n" * 100)
    given = {"normalised": "largest", "period_s": 1e-3}
    assert_allclose(read_fade_series(path, unit="dB", **given).power[:2], [1.0, 0.1])
    with pytest.raises(FadeSeriesError, match="the unit given is 'linear'; give the one that the file says"):
        read_fade_series(path, unit="linear", **given)


def test_a_series_as_long_as_is_needed_is_long_enough():
    series = series_of(np.ones(1000))
    series.at_least_as_long_as(series.duration_s, "a word lasts")
    with pytest.raises(FadeSeriesError, match=r"the series lasts 10 ms and a word lasts 10\.01 ms"):
        series.at_least_as_long_as(series.duration_s * (1.0 + 1e-6), "a word lasts")


def test_powers_and_levels_are_taken_up_to_the_largest_and_darkness_too():
    assert series_of(np.r_[np.ones(299), 1e30]).power[-1] == pytest.approx(300.0)
    assert series_of(np.r_[np.full(299, -np.inf), 300.0], unit="dB", normalised="largest").power[-1] == 1.0
    assert series_of(np.r_[np.zeros(299), 2.0], normalised="largest").power[[0, -1]].tolist() == [0.0, 1.0]


# ------------------------------------------------------------------------------------------ series unlike each other
UNEVEN = replace(series_of(scintillation(1000, 25, 4, 0.7), normalised="largest"), period_s=2.5e-5, source="uneven")
OWN_RATE = 7e6


def uneven(kind="none", span_s=0.0, coded=CODE, rate=OWN_RATE, series=UNEVEN):
    return CodedLink(coded, series, rate, kind, span_s)


def numbers_of(found):
    """All numbers of a coded link under fades, but for its curve."""
    fades = found.fades
    return [
        found.margin_db, found.span_s, found.window_s, found.words, found.ratio.value, found.ratio.low,
        found.ratio.high, found.lost.value, found.lost.low, found.lost.high, found.penalty_db, found.margin_left_db,
        fades.level, fades.share, fades.per_second, fades.mean_s, fades.median_s, fades.ninetieth_s, fades.longest_s,
        fades.unresolved,
    ]  # fmt: skip


@pytest.mark.parametrize(("link", "margin_db", "target", "expected", "curve"), [
    (uneven(), 7.5, 3e-5,
     [7.5, 0.0, 2.5e-05, 1000.0, 0.0362478257, 0.0, 0.0957570393, 0.341, 0.104529815, 0.644623001, 13.5909778,
     -6.09097777, 0.0437423612, 0.025, 40.0, 0.000625, 0.000625, 0.000625, 0.000625, 0.0],
     [0.0, 5e-05, 7.5e-05, 0.0001, 0.000175, 0.00025, 0.000375, 0.00055, 0.000825, 0.00125, 0.001875, 0.0028,
     0.004175, 0.00625, 13.5909778, 13.5883499, 13.5843323, 13.5779295, 13.5530313, 13.5244777, 13.4885411,
     13.4522365, 12.8218863, 11.7061622, 11.807073, 10.8896959, 9.86190859, 8.04150712]),
    (uneven("block", 8e-4), 6.25, 1e-7,
     [6.25, 0.0008, 0.0008, 31.0, 0.0281438377, 0.0, 0.0673965913, 0.64516129, 0.378402862, 0.859206375, 12.3322124,
     -6.08221242, 0.0584492252, 0.059, 120.0, 0.000491666667, 0.0003, 0.00078, 0.0009, 0.0],
     [0.0, 5e-05, 7.5e-05, 0.0001, 0.000175, 0.00025, 0.000375, 0.00055, 0.000825, 0.00125, 0.001875, 0.0028,
     0.004175, 0.00625, 13.9465049, 13.9438842, 13.9398207, 13.9334497, 13.9041861, 13.8986159, 13.8444255,
     13.7764891, 13.1921877, 12.3013689, 12.1434545, 11.4244356, 10.5666297, 9.06074144]),
    (uneven("convolutional", 1.3e-3), 6.25, 1e-7,
     [6.25, 0.0013, 0.0013, 949.0, 0.0224430433, 0.0, 0.0709505769, 0.617492097, 0.283367822, 0.882942139, 12.402851,
     -6.15285103, 0.05750623, 0.054, 120.0, 0.00045, 0.000275, 0.000735, 0.00085, 0.0],
     [0.0, 5e-05, 7.5e-05, 0.0001, 0.000175, 0.00025, 0.000375, 0.00055, 0.000825, 0.00125, 0.001875, 0.0028,
     0.004175, 0.00625, 13.9465049, 13.9441645, 13.9401025, 13.9342991, 13.9066802, 13.8641153, 13.7620863,
     13.5626215, 13.1568987, 12.4758459, 11.9097681, 11.3823952, 10.3275605, 9.10382617]),
    (uneven(coded=Threshold("long", 0.5, 1400, 0.6)), 6.75, 0.02,
     [6.75, 0.0, 0.0002, 125.0, 0.472, 0.197311174, 0.746688826, 0.472, 0.212721439, 0.754289605, 13.890703,
     -7.14070303, 0.0408253294, 0.022, 40.0, 0.00055, 0.00055, 0.00055, 0.00055, 0.0],
     [0.0, 5e-05, 7.5e-05, 0.0001, 0.000175, 0.00025, 0.000375, 0.00055, 0.000825, 0.00125, 0.001875, 0.0028,
     0.004175, 0.00625, 13.890703, 13.890703, 13.890703, 13.890703, 13.890703, 14.057398, 13.5577233, 14.7438344,
     13.9244916, 12.4607867, 12.5933495, 11.2755779, 9.88679241, 7.61971021]),
    (uneven("convolutional", 6e-4, Threshold("short", 0.5, 90, 0.4)), 5.5, 0.011,
     [5.5, 0.0006, 0.0006, 977.0, 0.681678608, 0.395892974, 0.967464242, 0.681678608, 0.352292109, 0.914726718,
     14.3871376, -8.88713764, 0.0364154965, 0.017, 40.0, 0.000425, 0.000425, 0.000425, 0.000425, 0.0],
     [0.0, 5e-05, 7.5e-05, 0.0001, 0.000175, 0.00025, 0.000375, 0.00055, 0.000825, 0.00125, 0.001875, 0.0028,
     0.004175, 0.00625, 14.8704465, 14.8521037, 14.8871005, 14.8427858, 14.8463594, 14.7781415, 14.6697235,
     14.4741563, 13.9757252, 13.1500576, 12.5305707, 11.8459845, 9.76301112, 8.203162]),
])  # fmt: skip
def test_a_coded_link_under_fades_of_numbers_unlike_each_other(link, margin_db, target, expected, curve):
    found = coded_fading(link, margin_db, target)
    assert numbers_of(found) == pytest.approx(expected, rel=1e-6, abs=1e-12)
    assert [*found.curve.span_s, *found.curve.penalty_db] == pytest.approx(curve, rel=1e-6, abs=1e-9)
    assert (found.code, found.source, found.target) == (link.code.name, "uneven", target)
    assert found.interleaving == link.interleaving


@pytest.mark.parametrize(("series", "level", "expected"), [
    ("7 7 7 1 1 7 1 7 1 1 1 1 7 1 1", 2.0, [9 / 15, 4 / 15, 7 / 3, 2.0, 3.6, 4.0, 1 / 9]),
    ("1 1 1 7 2 7 7 3 3 7 7 7 7 7 7", 3.0, [4 / 15, 1 / 15, 1.0, 1.0, 1.0, 1.0, 0.25]),
    ("1 1 7 7 7 7 7 7 7 7 7 7 7 7 1", 2.0, [3 / 15, 1 / 15, *[math.nan] * 4, 1 / 3]),
    ("1 1 1 1 1 1 1 1 1 1 1 1 1 1 1", 2.0, [1.0, 0.0, *[math.nan] * 4, 0.0]),
    ("7 7 7 7 7 7 7 7 7 7 7 7 7 7 7", 2.0, [0.0, 0.0, *[math.nan] * 4, 0.0]),
])  # fmt: skip
def test_the_fades_of_a_few_samples_are_counted_by_hand(series, level, expected):
    power = np.array(series.split(), dtype=np.float64)
    found = FadeSeries(power, 1.0, "few", "as-given").fades(level)
    names = ("share", "per_second", "mean_s", "median_s", "ninetieth_s", "longest_s", "unresolved")
    assert [getattr(found, name) for name in names] == pytest.approx(expected, rel=1e-12, nan_ok=True)
    assert found.level == level
    halved = FadeSeries(power, 0.5, "few", "as-given").fades(level)
    assert [halved.share, halved.unresolved] == [found.share, found.unresolved]
    assert [halved.per_second / 4.0, halved.mean_s] == pytest.approx(
        [found.per_second / 2.0, found.mean_s / 2.0], nan_ok=True
    )


@pytest.mark.parametrize(("values", "length", "blocks", "sliding"), [
    ([1.0, 2.0, 4.0, 8.0, 16.0], 2, [1.5, 6.0], [1.5, 3.0, 6.0, 12.0]),
    ([1.0, 2.0, 4.0, 8.0, 16.0], 3, [7 / 3], [7 / 3, 14 / 3, 28 / 3]),
    ([5.0, 7.0], 2, [6.0], [6.0]),
])  # fmt: skip
def test_windows_stand_behind_each_other_or_slide(values, length, blocks, sliding):
    assert coded_module._blocks(np.array(values), length) == pytest.approx(blocks, rel=1e-12)
    assert coded_module._sliding(np.array(values), length) == pytest.approx(sliding, rel=1e-12)


@pytest.mark.parametrize(("function", "value", "expected"), [
    (lambda db: 10.0 ** (-0.1 * db), 0.5, 10.0 * math.log10(2.0)),
    (lambda db: 10.0 ** (-0.1 * db), 10.0**-4.2, 42.0),
    (lambda db: 10.0 ** (-0.1 * db), 10.0**5.7, -57.0),
    (lambda db: 10.0 ** (-0.1 * db), 10.0**6.1, -60.0),
    (lambda db: 10.0 ** (-0.1 * db), 10.0**-6.1, math.inf),
    (lambda db: 10.0 ** (-0.1 * db), 10.0**-5.9, 59.0),
    (lambda db: 0.25, 0.25, -60.0),
    (lambda db: 0.25, 0.2, math.inf),
])  # fmt: skip
def test_extra_power_is_looked_for_up_to_60_db_either_way(function, value, expected):
    assert coded_module._falling(function, value) == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize(("count", "each", "left"), [(5, 1, 5), (16, 1, 16), (47, 2, 23), (48, 3, 16), (100, 6, 16)])
def test_an_interval_is_told_from_sixteen_parts_or_more(count, each, left):
    values = np.arange(float(count)) ** 2
    parts = [values[k * each : (k + 1) * each].mean() for k in range(left)]
    assert coded_module._parts(values) == pytest.approx(parts, rel=1e-12)
    found = coded_module._interval(values)
    half = student(0.99, left - 1) * np.std(parts, ddof=1) / math.sqrt(left)
    mean = values.mean()
    assert (found.value, found.low, found.high) == pytest.approx((mean, max(mean - half, 0.0), mean + half), rel=1e-9)
    alone = coded_module._interval(values[3:4])
    assert (alone.value, alone.low, alone.high) == (9.0, 0.0, math.inf)


@pytest.mark.parametrize(("call", "words"), [
    (lambda: uneven("blok", 1e-3), "the interleaving is 'blok'; give one of none, block, convolutional."),
    (lambda: uneven("none", 1e-3), "interleaving is 'none' and its span 1 ms; give a span above 0 s, or interleaving "
     '"none" without one.'),
    (lambda: uneven("convolutional"), "interleaving is 'convolutional' and its span 0 s; give a span above 0 s, or "
     'interleaving "none" without one.'),
    (lambda: uneven(rate=500.0), "uneven: the series lasts 25 ms and a code word, 35 bits, lasts 70 ms; give a series "
     "of many times that, or shorten the latter."),
    (lambda: uneven("block", 0.0312), "uneven: the series lasts 25 ms and the interleaver spans 31.2 ms; give a "
     "series of many times that, or shorten the latter."),
    (lambda: series_of(np.ones(300), unit="dBm"), "series: the unit is 'dBm'; give one of linear, dB."),
    (lambda: series_of(np.ones(300), normalised="1"), "series: the normalisation is '1'; give one of mean, largest, "
     "as-given."),
    (lambda: FadeSeries.of(np.ones(300), -2e-3, "s", unit="dB", normalised="mean"), "s: the sampling period is -2 ms: "
     "it must be finite, above 0 s."),
    (lambda: series_of(np.ones((2, 150))), "series: the powers have the shape (2, 150); give one series, of shape "
     "(samples,)."),
    (lambda: series_of(np.ones(199)), "series: the series has 199 samples; from 200 to 2000000 are taken: give a "
     "longer one."),
    (lambda: series_of(np.r_[np.ones(250), -3.5, np.inf, -1.0]), "series: sample 250 is -3.5, 3 such samples in "
     'all: a power must be finite, 0 or above and at most 1e+30 (unit "dB" if these are levels); cut out a part '
     "without them."),
    (lambda: series_of(np.r_[np.ones(250), np.inf, -1.0]), "series: sample 250 is inf, 2 such samples in all: "
     "a power must be finite, 0 or above and at most 1e+30; cut out a part without them."),
    (lambda: series_of(np.r_[np.zeros(250), np.nan, -np.inf, 301.0, -5.0], unit="dB"), "series: sample 250 is nan, "
     "2 such samples in all: a power must be a number up to 300 dB; cut out a part without them."),
    (lambda: series_of(np.zeros(200)), "series: no sample is above 0: there is no light in the series; name another "
     "one."),
    (lambda: series_of(np.tile([1.0, 1.0, 0.1], 100), normalised="largest").resolves(0.5), "series: the series is "
     "sampled slower than its fades: 100 % of the time below -3.0 dB is in fades of a single sample, 10 µs, and at "
     "most 10 % may be; give a series that is sampled faster."),
])  # fmt: skip
def test_a_refusal_of_a_series_is_one_whole_sentence(call, words):
    with pytest.raises(FadeSeriesError) as refused:
        call()
    assert str(refused.value) == words


@pytest.mark.parametrize(("text", "given", "words"), [
    ("power (dBW)\n" + "1\n" * 300, {}, "NAME: the file says that the powers are in dBW, and the unit given is "
     "'linear'; give the one that the file says, or correct it."),
    ("power (mW)\n" + "1\n" * 300, {"unit": "dB"}, "NAME: the file says that the powers are in mW, and the unit given "
     "is 'dB'; give the one that the file says, or correct it."),
    ("power\n" + "1\n" * 300, {"period_s": None}, "NAME: the file does not say how fast it was sampled; give the time "
     "between two samples (sampling, period_s), or a column of times."),
    ("power\n" + "1\n" * 250 + "-2\n", {"name": "Ours"}, "Ours: sample 250 is -2, 1 such sample in all: a "
     'power must be finite, 0 or above and at most 1e+30 (unit "dB" if these are levels); cut out a part without '
     "them."),
])  # fmt: skip
def test_a_refusal_of_a_file_of_powers_is_one_whole_sentence(tmp_path, text, given, words):
    path = tmp_path / "a.csv"
    path.write_text(text)
    with pytest.raises(FadeSeriesError) as refused:
        read_fade_series(path, **{"unit": "linear", "normalised": "mean", "period_s": 1e-3, **given})
    assert str(refused.value).replace(str(path), "NAME") == words


@pytest.mark.parametrize(("channel", "first"), [("b", 4.0), (2, 4.0), ("a", 0.5), (1, 0.5)])
def test_a_channel_of_a_file_is_read_by_name_or_number_with_its_hash(tmp_path, channel, first):
    path = tmp_path / "a.csv"
    path.write_text("time (s),a,b\n" + "".join(f"{k * 2e-4:.4f},{0.5 + k % 7},{4 + k % 3}\n" for k in range(250)))
    found = read_fade_series(str(path), unit="linear", normalised="as-given", channel=channel, name="Ours")
    assert (found.power[0], found.power.size, found.source, found.normalised) == (first, 250, "Ours", "as-given")
    assert found.sha256 == hashlib.sha256(path.read_bytes()).hexdigest()
    assert found.period_s == pytest.approx(2e-4, rel=1e-9)
    assert part(found, 7, 19).power.tolist() == found.power[7:19].tolist()
    assert (part(found, 7, 19).duration_s, part(found, 7, 19).source) == (pytest.approx(12 * 2e-4), "Ours")


@pytest.mark.parametrize(("snr_db", "expected"), [
    (-60.0, [0.5, 0.5, 1.65303824e-06, 6.0]),
    (-3.0, [0.15349, 0.15349, 0.486365675, 6.0]),
    (-0.4, [0.00106467506, 0.00106467506, 0.69065244, 6.0]),
    (1.25, [6.12500912e-06, 6.12500912e-06, 0.812602058, 6.0]),
    (4.5, [9.37954889e-13, 9.37954889e-13, 0.964812577, 6.0]),
    (15.0, [1.00889452e-69, 1.00889452e-69, 1.0, 6.0]),
])  # fmt: skip
def test_the_code_of_ccsds_has_its_numbers_at_each_power(snr_db, expected):
    snr = np.array([10.0 ** (0.1 * snr_db)])
    found = [*CODE.at(snr), *CODE.ratio(CODE.parts(snr)), *mutual_information(snr), len(CODE.parts(snr))]
    assert found == pytest.approx(expected, rel=1e-6, abs=0.0)
    mixed = CODE.ratio([0.5 * (a + b) for a, b in zip(CODE.parts(snr), CODE.parts(2.0 * snr), strict=True)])
    assert CODE.at(2.0 * snr)[0] <= mixed[0] <= CODE.at(snr)[0]


@pytest.mark.parametrize("period_s", [0.0, -1.0, math.nan, math.inf])
def test_a_sampling_period_that_is_none_is_refused_as_a_period(tmp_path, period_s):
    path = tmp_path / "a.csv"
    path.write_text("power\n" + "1\n" * 300)
    with pytest.raises(FadeSeriesError, match=r"a\.csv: the sampling period is .*: it must be finite, above 0 s"):
        read_fade_series(path, unit="linear", normalised="mean", period_s=period_s)


DIPS = FadeSeries.of(
    np.r_[[0.1] * 3, [1.0] * 50, [0.1], [1.0] * 60, [0.1] * 4, [1.0] * 70, [0.1] * 9, [1.0] * 40, [0.1] * 2],
    2e-3, "dips", unit="linear", normalised="as-given",
)  # fmt: skip


def flat_of(powers, normalised, unit="linear"):
    return FadeSeries.of(np.repeat(powers, 100), 2e-3, "flat", unit=unit, normalised=normalised)


@pytest.mark.parametrize(("found", "expected"), [
    (lambda: [(s := flat_of([4.0, 1.0, 3.0], "mean")).power[0], s.power.mean(), s.duration_s], "1.5 1 0.6"),
    (lambda: [(s := flat_of([4.0, 1.0, 3.0], "largest")).power[1], s.power.max()], "1 1"),
    (lambda: [flat_of([-3.0, 2.0], "as-given", unit="dB").power[x] for x in (0, 1)], "0.501187234 0.501187234"),
    (lambda: [flat_of([-math.inf, 2.0], "largest", unit="dB").power[x] for x in (0, 1)], "0 0"),
    (lambda: [(f := DIPS.fades(0.5)).share, f.per_second, f.mean_s, f.median_s, f.ninetieth_s, f.longest_s,
            f.unresolved, f.level],
     "0.0794979079 8.36820084 0.00933333333 0.008 0.016 0.018 0.0526315789 0.5"),
    (lambda: [(f := DIPS.fades(0.05)).share, f.per_second, f.mean_s, f.unresolved], "0 0 nan 0"),
    (lambda: [(f := DIPS.fades(9.0)).share, f.per_second, f.mean_s, f.unresolved], "1 0 nan 0"),
    (lambda: [part(DIPS, 5, 30).power.size, part(DIPS, 5, 30).power.sum(), part(DIPS, 5, 30).duration_s], "25 25 0.05"),
    (lambda: [CODE.snr_for(x) for x in (0.4, 1e-3, 1e-9, 1e-30)], "0.326065054 0.916837117 2.14032479 6.9108001"),
    (lambda: CODE.at([0.0, 0.05, 0.4, 3.0]), "0.5 0.49764532 0.303597411 1.47063659e-13"),
    (lambda: mutual_information(np.array([0.0, 0.2, 1.0, 9.0])), "0 0.241510142 0.721762347 0.999933907"),
    (lambda: [x[0] for x in CODE.parts(np.array([0.7]))],
     "0.00839684711 0.151241488 0.328850021 0.440387168 0.490596802 0.599240192"),
    (lambda: CODE.ratio([np.array([x, 0.5 * x]) for x in (0.9, 0.5, 0.4, 0.35, 0.33, 0.3)]),
     "0.0439640897 0.499844362"),
    (lambda: Threshold("t", 0.5, 800, 0.6).ratio([np.array([0.1, 0.9])]), "1 0"),
    (lambda: [Threshold("t", 0.5, 800, 0.6).snr_for(1e-9), *Threshold("t", 0.5, 800, 0.6).parts(np.array([0.6]))[0]],
     "0.6 0.546294975"),
    (lambda: [(w := uneven(rate=2e6)).word_s, w.window, uneven("block", 3e-4).window, uneven("block", 1e-7,
            rate=1e9).window],
     "1.75e-05 1 12 1"),
    (lambda: [uneven("block", 4e-4).mean_ratio(0.9), uneven("convolutional", 4e-4).mean_ratio(0.9),
            uneven().mean_ratio(0.9)],
     "0.427456862 0.426860638 0.427365128"),
    (lambda: [(u := uneven("block", 4e-4)).penalty_db(1e-4), *(c := u.curve(1e-4, 3)).span_s, *c.penalty_db],
     "13.0569206 0 5e-05 0.00055 0.00625 13.4656499 13.4630202 13.3339969 7.81994077"),
    (lambda: [(c := coded_fading(uneven("block", 4e-3), 6.0, 1e-4)).words, c.ratio.value, c.lost.value,
            c.margin_left_db],
     "6 0.0442614707 0.666666667 -3.87090539"),
])  # fmt: skip
def test_a_series_at_its_edges_has_these_numbers(found, expected):
    assert list(found()) == pytest.approx([float(each) for each in expected.split()], rel=1e-6, abs=0.0, nan_ok=True)


@pytest.mark.parametrize(("found", "expected"), [
    (lambda: flat_of([1.0], "mean"),
     "flat: the series has 100 samples; from 200 to 2000000 are taken: give a longer one."),
    (lambda: flat_of([0.0, 0.0], "mean"),
     "flat: no sample is above 0: there is no light in the series; name another one."),
    (lambda: flat_of([1.0, -2.0], "mean"),
     "flat: sample 100 is -2, 100 such samples in all: a power must be finite, 0 or above and at most "
     '1e+30 (unit "dB" if these are levels); cut out a part without them.'),
    (lambda: flat_of([1.0, 301.0], "mean", unit="dB"),
     "flat: sample 100 is 301, 100 such samples in all: a power must be a number up to 300 dB; cut out "
     "a part without them."),
    (lambda: flat_of([1.0, 2e30], "mean"),
     "flat: sample 100 is 2e+30, 100 such samples in all: a power must be finite, 0 or above and at most "
     "1e+30; cut out a part without them."),
    (lambda: flat_of([1.0, 2.0], "median"),
     "flat: the normalisation is 'median'; give one of mean, largest, as-given."),
    (lambda: flat_of([1.0, 2.0], "mean", unit="W"), "flat: the unit is 'W'; give one of linear, dB."),
    (lambda: flat_of([math.nan, 2.0], "mean", unit="dB"),
     "flat: sample 0 is nan, 100 such samples in all: a power must be a number up to 300 dB; cut out "
     "a part without them."),
    (lambda: FadeSeries.of(np.ones((100, 2)), 1.0, "s", unit="dB", normalised="mean"),
     "s: the powers have the shape (100, 2); give one series, of shape (samples,)."),
    (lambda: FadeSeries.of(np.ones(200), 0.0, "s", unit="dB", normalised="mean"),
     "s: the sampling period is 0 s: it must be finite, above 0 s."),
    (lambda: uneven("random", 1e-3), "the interleaving is 'random'; give one of none, block, convolutional."),
    (lambda: uneven("block", 0.0),
     "interleaving is 'block' and its span 0 s; give a span above 0 s, or interleaving \"none\" without one."),
    (lambda: uneven("none", 1e-3),
     "interleaving is 'none' and its span 1 ms; give a span above 0 s, or interleaving \"none\" without one."),
    (lambda: uneven("block", -1e-3), "uneven: the span of the interleaver is -1 ms: it must be finite, at least 0 s."),
    (lambda: uneven("block", 1.0),
     "uneven: the series lasts 25 ms and the interleaver spans 1 s; give a series of many times that, or shorten "
     "the latter."),
    (lambda: uneven(rate=10.0),
     "uneven: the series lasts 25 ms and a code word, 35 bits, lasts 3.5 s; give a series of many times that, or "
     "shorten the latter."),
    (lambda: uneven(rate=0.0), "uneven: the data rate is 0 bit/s: it must be finite, above 0 bit/s."),
    (lambda: coded_fading(uneven(), 3.0, 0.0), "uneven: the error ratio is 0: it must be finite, above 0, at most 1."),
    (lambda: code("ccsds"), 'no code is called "ccsds"; there is ccsds-k7-1-2'),
])  # fmt: skip
def test_a_refusal_of_a_coded_series_is_one_whole_sentence(found, expected):
    with pytest.raises((ValueError, ArithmeticError)) as refused:
        found()
    assert str(refused.value) == expected


@pytest.mark.parametrize(("words", "high"), [(3, 0.8290), (15, 0.2976)])
def test_a_few_words_none_of_which_is_lost_have_the_interval_of_as_many_trials(words, high):
    found = coded_module._share(np.zeros(words, dtype=bool))
    assert (found.value, found.low, found.high) == (0.0, 0.0, pytest.approx(high, abs=1e-4))
    assert high == pytest.approx(1.0 - 0.005 ** (1.0 / words), abs=1e-4)


@pytest.mark.parametrize("unit", ["linear", "dB"])
@pytest.mark.parametrize("normalised", ["mean", "largest", "as-given"])
def test_powers_are_a_copy_that_nobody_writes_into(unit, normalised):
    given = np.linspace(0.5, 1.5, 300)
    series = series_of(given, unit=unit, normalised=normalised)
    before = series.power.copy()
    for power in (series.power, part(series, 10, 250).power):
        with pytest.raises(ValueError, match="read-only"):
            power[0] = 7.0
    given[:] = 9.0
    np.testing.assert_array_equal(series.power, before)


def test_a_part_of_a_series_is_on_its_scale_and_keeps_what_is_said_of_it():
    series = FadeSeries.of(np.arange(1.0, 401.0), 2e-3, "a.csv", unit="linear", normalised="largest", sha256="abc")
    some = part(series, 100, 300)
    assert (some.period_s, some.source, some.normalised, some.sha256) == (2e-3, "a.csv", "largest", "abc")
    assert some.power.tolist() == pytest.approx([k / 400.0 for k in range(101, 301)])
    assert some.duration_s == pytest.approx(0.4)


@pytest.mark.parametrize(("margin_db", "lost"), [(1e-3, 0.0), (0.5, 0.0), (-0.05, 1.0), (-3.0, 1.0)])
def test_words_are_lost_as_soon_as_their_error_ratio_is_above_the_target(margin_db, lost):
    """At constant power, where 0.05 dB less makes the errors hardly more."""
    found = coded_fading(linked(series_of(np.full(400, 3.0)), 20), margin_db, 1e-6)
    assert (found.lost.value, found.words) == (lost, 20)
    low, high = {1e-3: (0.9, 1.0), 0.5: (0.0, 0.5), -0.05: (1.1, 1.9), -3.0: (1e3, 1e6)}[margin_db]
    assert low < found.ratio.value / 1e-6 < high


@pytest.mark.parametrize("margin_db", [2.0, -1.5])
def test_where_no_power_makes_up_for_the_fades_they_are_those_below_what_the_code_needs_at_the_power_there_is(
    margin_db,
):
    power = np.ones(1024)
    power[100:140], power[300:330] = 0.0, 10.0**-0.05  # darkness, and 0.5 dB less
    found = coded_fading(linked(series_of(power, normalised="as-given")), margin_db, 1e-6)
    assert (found.penalty_db, found.margin_left_db) == (math.inf, -math.inf)
    assert found.fades.level == pytest.approx(10.0 ** (-0.1 * margin_db), rel=1e-12)
    assert found.fades.share == pytest.approx(40 / 1024 if margin_db > 0.5 else 1.0)


@pytest.mark.parametrize(("word", "span", "window"), [(4, 0, 4), (4, 2, 4), (4, 6, 6), (0.25, 0, 1), (0.25, 3, 3)])
def test_a_word_sees_the_samples_of_the_longer_of_itself_and_its_interleaver(word, span, window):
    block = Threshold("block", 0.5, round(word * BITS), 1.0)
    assert linked(series_of(np.ones(400)), span, coded=block).window == window


def test_a_level_without_end_is_refused_and_one_of_no_light_is_taken():
    dark = np.r_[np.zeros(250), -np.inf, -3.0]
    assert series_of(dark, unit="dB", normalised="as-given").power[250:].tolist() == [0.0, pytest.approx(10.0**-0.3)]
    with pytest.raises(FadeSeriesError) as refused:
        series_of(np.r_[dark, np.inf], unit="dB")
    assert str(refused.value) == (
        "series: sample 252 is inf, 1 such sample in all: a power must be a number up to 300 dB; cut out a part "
        "without them."
    )


def test_a_series_that_is_too_short_is_refused_as_that_before_its_sampling_is_asked_for(tmp_path):
    path = tmp_path / "short.csv"
    for samples, words in ((199, "the series has 199 samples"), (200, "the file does not say how fast it was sampled")):
        path.write_text("power\n" + "1\n" * samples)
        with pytest.raises(FadeSeriesError, match=f"^powers: {words}"):
            read_fade_series(path, unit="linear", normalised="mean", name="powers")
