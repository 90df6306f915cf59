"""Code words lost to pointing: against whole runs in memory, the closed form of the share of time, and the fades."""

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from numpy.testing import assert_allclose

from link_files import link_file
from microrad import link
from microrad.core.intervals import binomial_band, clustered_band
from microrad.link.coupling import Aberrations, Pupil, SingleModeFibre
from microrad.link.pointing import code_words, outage
from microrad.link.pointing.code_words import FadeMargin, words_asked
from microrad.link.pointing.light import Light
from microrad.link.pointing.statistics import outage_probability, radius_of_loss_rad, transmission
from microrad.link.radial_error import Jitter
from microrad.loop.disturbance import first_order
from microrad.loop.disturbance.windows import ErrorIndex
from microrad.loop.pointing_loop.ensemble import Span
from microrad.loop.pointing_loop.kernel_arrays import LANES
from microrad.loop.pointing_loop.linear import close
from microrad.loop.pointing_loop.simulated_windows import ask
from microrad.loop.pointing_loop.traces import trace
from microrad.loop.pointing_loop.windows import windowed_in_all
from microrad.loop.workbench import Controller, Loop
from microrad.mirror.model import Mirror

SLOW = first_order(160e-12, 5.0, convention="per-axis", name="vibration")
LOOP = Loop(
    mirror=Mirror.of(50e-6, [1.0], [1 / 3000**2, 2 * 0.1 / 3000, 1.0]),
    rate_hz=1000.0,
    vibration=SLOW,
    sensor_noise_rad=0.5e-6,
    steps_per_sample=2,
)
CONTROLLER = LOOP.assembled(Controller.pid(0.0, 5e5, rate_hz=1000.0))
SPAN = Span(3.3, 0.3, 1)
MARGIN = FadeMargin(Light(half_angle_rad=100e-6, ahead_rad=5e-6), loss_db=1.0)


def lost(margin=MARGIN, word_s=0.02, span=SPAN, runs=3, **settings):
    asked = words_asked(margin, word_s, LOOP.parts, span)
    (found,) = ask([asked], LOOP.parts, CONTROLLER, span, runs, **settings)
    return found


@pytest.mark.promise("pointing-39", "pointing-40")
def test_words_are_those_of_whole_runs_in_memory():
    words, time = [], []
    for run in range(3):
        error = trace(LOOP.parts, CONTROLLER, SPAN, run).error_rad[300:, 0]
        power = np.exp(-2.0 * ((np.abs(error) + 5e-6) / 100e-6) ** 2)
        words.append(np.mean(power.reshape(-1, 20).mean(axis=1) < 10.0**-0.1))
        time.append(np.mean(power < 10.0**-0.1))
    found = lost()
    assert found.words == 3 * 150
    assert 0.01 < found.lost.value < found.time.value < 0.99
    assert_allclose([found.lost.value, found.time.value], [np.mean(words), np.mean(time)], rtol=1e-12)
    assert found.lost.low < found.lost.value < found.lost.high
    assert found == lost(threads=1)


@pytest.mark.promise("link-75")
def test_words_of_a_link_between_two_alike_are_those_of_pairs_of_runs_in_memory():
    fibre = SingleModeFibre(Pupil(0.04, 1.55e-6, truncation=1.1))
    margin = FadeMargin(replace(MARGIN.light, end=fibre), 3.0)
    words, time = [], []
    for run in range(3):
        ours, theirs = (trace(LOOP.parts, CONTROLLER, SPAN, each).error_rad[300:, 0] for each in (run, LANES + run))
        power = np.exp(-2.0 * ((np.abs(ours) + 5e-6) / 100e-6) ** 2)
        power *= 10.0 ** (-0.1 * (fibre.loss_db(theirs) - fibre.loss_db(0.0)))
        words.append(np.mean(power.reshape(-1, 20).mean(axis=1) < 10.0**-0.3))
        time.append(np.mean(power < 10.0**-0.3))
    found = lost(margin)
    assert 0.01 < found.lost.value < found.time.value < 0.99
    assert_allclose([found.lost.value, found.time.value], [np.mean(words), np.mean(time)], rtol=1e-12)
    assert lost(replace(margin, light=MARGIN.light)).time.value < 0.5 * found.time.value


@pytest.mark.promise("link-75")
def test_the_light_between_two_alike_counts_the_direction_of_the_partners_error():
    bent = SingleModeFibre(Pupil(0.15, 1.55e-6, 0.2, Aberrations(coma_m=100e-9), 1.1))
    light = Light(100e-6, 0.0, bent)
    rng = np.random.default_rng(3)
    ours, theirs = rng.normal(0.0, 3e-6, (2, 50, 2, 4))
    power = light.power(np.concatenate([ours, theirs], axis=1))
    sent = np.exp(-2.0 * np.sum(ours**2, axis=1) / 100e-6**2)
    assert_allclose(power, sent * bent.share(theirs[:, 0], theirs[:, 1]) / bent.share(0.0), rtol=1e-12)
    assert not np.allclose(power, sent * bent.share(theirs[:, 1], theirs[:, 0]) / bent.share(0.0), rtol=1e-3)


def test_the_share_of_time_is_that_of_a_gaussian_and_short_words_have_it_too():
    margin = FadeMargin(Light(100e-6, 0.0), 1.0)
    found = lost(margin, 0.002, Span(10.3, 0.3, 1), 64)
    variance = windowed_in_all(close(LOOP.parts, CONTROLLER), ErrorIndex("APE"), at_samples=True)
    wanted = float(outage_probability(Jitter((0.0, 0.0), (math.sqrt(variance[0]), 0.0)), 100e-6, 1.0))
    assert found.time.low < wanted < found.time.high < 1.1 * found.time.low
    assert found.lost.value == pytest.approx(found.time.value, rel=0.1, abs=0.0)
    long = lost(margin, 10.0, Span(10.3, 0.3, 1), 64)  # a mean over all of a run hardly varies, and is above the least
    assert (long.words, long.lost.value, long.time) == (64, 0.0, found.time)


@pytest.mark.promise("pointing-39", "pointing-40")
def test_the_margin_is_that_of_the_link_s_fades(tmp_path):
    data = link.of(link_file(tmp_path).mission)
    margin, under = FadeMargin.of(data), outage.Exposure.stated(data)
    reach = under.fall.error_rad(under.on_axis_db - data.requirement.margin_db)
    angle = margin.light.half_angle_rad
    assert angle == under.fall.half_angle_rad
    assert float(transmission(reach, angle)) == pytest.approx(10.0 ** (-0.1 * margin.loss_db), rel=1e-12, abs=0.0)
    assert float(radius_of_loss_rad(angle, margin.loss_db)) == pytest.approx(reach, rel=1e-12, abs=0.0)


@pytest.mark.promise("pointing-40")
def test_a_link_that_misses_its_margin_on_the_axis_loses_all_words():
    found = lost(FadeMargin(Light(100e-6, 0.0), -0.1))
    assert (found.lost.value, found.time.value, found.lost.high) == (1.0, 1.0, 1.0)
    assert found.lost.low == pytest.approx(0.005 ** (1.0 / found.words), rel=1e-9, abs=0.0)


def test_one_run_tells_nothing_of_its_interval():
    assert (lost(runs=1).lost.low, lost(runs=1).lost.high) == (0.0, 1.0)


@pytest.mark.promise("pointing-40")
def test_the_interval_of_clusters_holds_whether_their_trials_are_alike_or_not():
    """Misses of 1600 intervals of 99 %, at each side of what chance allows: 16 are wanted of one that is exact."""
    rng = np.random.default_rng(1)
    for alike in (0.0, 0.1, 0.5):
        misses, widths = 0, []
        for _ in range(1600):
            own = rng.beta(0.3 * (1 / alike - 1), 0.7 * (1 / alike - 1), 64) if alike else np.full(64, 0.3)
            low, high = clustered_band(rng.binomial(50, own) / 50, 50, 0.99)
            misses += not low < 0.3 < high
            widths.append(high - low)
        assert 2 < misses < 26, (alike, misses)
        wanted = 2.0 * 2.576 * math.sqrt(0.21 * (1.0 + 49.0 * alike) / 3200.0)
        assert wanted < np.mean(widths) < 1.15 * wanted
    assert clustered_band(np.zeros(64), 50, 0.99) == (0.0, binomial_band(np.zeros(1), np.array([3200.0]), 0.99)[1][0])


@pytest.mark.promise("pointing-40")
@pytest.mark.parametrize(
    ("word_s", "runs", "words"),
    [
        (5.0, 2, "a code word of 5 s is longer than a run, of which 3 s are left behind its settling"),
        (0.001, 2, "a code word of 1 ms has less than two control samples, 1 ms apart"),
        (0.02, 0, "0 runs leave no errors"),
    ],
)
def test_words_that_no_run_can_have_are_refused(word_s, runs, words):
    with pytest.raises(ValueError, match=words) as refused:
        lost(MARGIN, word_s, runs=runs)
    assert "\n" not in str(refused.value)


# -------------------------------------------------------------------------------------------- counted slice by slice
def in_slices(tally, error, *cuts):
    for first, last in pairwise((0, *cuts, len(error))):
        tally.add(first, error[first:last])
    return tally.mean


@pytest.mark.parametrize(("length", "cuts"), [(7, (10, 11, 40)), (1, (50,)), (23, (23, 46)), (100, (3,))])
@pytest.mark.parametrize("loss_db", [0.7, 2.2, -0.5])
def test_words_on_two_axes_are_counted_in_any_slices(length, cuts, loss_db):
    error = np.random.default_rng(6).normal(8e-6, 21e-6, (107, 2, 5))
    light = Light(63e-6, 4e-6)
    found = in_slices(code_words._Lost(FadeMargin(light, loss_db), length), error, *cuts)
    power = np.exp(-2.0 * ((np.hypot(error[:, 0], error[:, 1]) + 4e-6) / 63e-6) ** 2)
    whole = 107 // length
    words = power[: whole * length].reshape(whole, length, 5).mean(axis=1)
    assert_allclose(found, [np.mean(each < 10.0 ** (-0.1 * loss_db), axis=0) for each in (words, power)], rtol=1e-12)


@pytest.mark.parametrize("span", [Span(3.3, 0.3, 1), Span(2.0, 0.5, 4)])
def test_the_answer_of_words_is_the_mean_of_the_runs_with_the_band_of_their_trials(span):
    asked = words_asked(MARGIN, 0.0234, LOOP.parts, span)
    shares = np.array([[0.11, 0.23], [0.05, 0.31], [0.17, 0.19], [0.29, 0.07]])
    found = asked.answer([shares, -shares])
    samples = round((span.duration_s - span.settle_s) * 1000.0)
    words = samples // 23
    assert (found.code_word_s, found.words, asked.twin) == (0.0234, 4 * words, False)
    for interval, by_run, trials in ((found.lost, shares[:, 0], words), (found.time, shares[:, 1], samples)):
        assert interval.value == pytest.approx(by_run.mean(), rel=1e-12)
        assert (interval.low, interval.high) == clustered_band(by_run, trials, 0.99)
    (tally,) = asked.tallies()
    assert tally._words.length == 23
    twin = replace(MARGIN, light=replace(MARGIN.light, end=SingleModeFibre(Pupil(0.04, 1.55e-6, truncation=1.1))))
    assert words_asked(twin, 0.02, LOOP.parts, span).twin


@pytest.mark.parametrize("receives", [{"pointing_error": "3 urad"}, {"twin": True}])
def test_the_margin_of_a_link_with_a_fibre_is_that_of_its_beam_and_of_all_that_it_may_lose(tmp_path, receives):
    table = {"into": "single-mode fibre", "mode_radius": "best", **receives}
    changes = {"beacon": None, "answer": None, "acquisition": None, "communication.coupling": table}
    beam = {"profile": "gaussian", "radius": "23 mm", "m_squared": 1.2}  # it falls off unlike a Gaussian
    changes |= {"communication.beam": beam, "conventions.pointing_loss": "pattern"}
    changes["communication.transmit_power"] = "9 W"
    data = link.of(link_file(tmp_path, changes, {"requirement.outage": 0.01}).mission)
    margin, under, twin = FadeMargin.of(data), outage.Exposure.stated(data), "twin" in receives
    assert (margin.light.end is None, margin.light.given_db > 0.0) == (not twin, not twin)
    spare = under.on_axis_db - margin.light.given_db - data.requirement.margin_db
    at_reach = float(transmission(under.fall.error_rad(spare), margin.light.half_angle_rad))
    assert at_reach == pytest.approx(10.0 ** (-0.1 * margin.loss_db), rel=1e-9)
    own = pytest.approx(under.fall.half_angle_rad, rel=1e-12)
    assert margin.loss_db == pytest.approx(spare, rel=1e-12) if twin else margin.light.half_angle_rad == own
    none = FadeMargin.of(data_short(data))
    assert none.loss_db == pytest.approx(spare + data.requirement.margin_db - 80.0, abs=1e-9)
    assert none.light == Light.of(data)


def data_short(data):
    """The link with more margin required than it has."""
    return replace(data, requirement=data.requirement.with_value("margin_db", 80.0))


@pytest.mark.parametrize(("word_s", "words"), [
    (3.4, "a code word of 3.4 s is longer than a run, of which 3 s are left behind its settling: make the runs longer"),
    (0.00149, "a code word of 1.49 ms has less than two control samples, 1 ms apart: it sees the power of a moment, "
     "and the share of time is its own; leave code_word out"),
])  # fmt: skip
def test_a_refusal_of_a_code_word_is_one_whole_sentence(word_s, words):
    with pytest.raises(ValueError) as refused:
        words_asked(MARGIN, word_s, LOOP.parts, SPAN)
    assert str(refused.value) == words


@pytest.mark.parametrize("axes", [1, 2])
def test_the_light_between_two_alike_is_split_between_their_axes(axes):
    bent = SingleModeFibre(Pupil(0.11, 1.55e-6, 0.1, Aberrations(coma_m=80e-9), 1.0), 0.4e-6)
    both = np.random.default_rng(8).normal(1e-6, 4e-6, (30, 2 * axes, 3))
    found = Light(70e-6, 3e-6, bent, 1.7).power(both)
    sent = np.exp(-2.0 * ((np.sqrt(np.sum(both[:, :axes] ** 2, axis=1)) + 3e-6) / 70e-6) ** 2)
    across = both[:, 3] if axes == 2 else 0.0
    assert_allclose(found, sent * bent.share(both[:, axes], across) / bent.share(0.0), rtol=1e-12)


def test_power_that_just_has_the_margin_is_not_below_it():
    """Words of five samples at full power, one of them with a sample that is not; the margin is of all the power."""
    error = np.zeros((15, 2, 3))
    error[7, 1] = 20e-6
    found = in_slices(code_words._Lost(FadeMargin(Light(63e-6, 0.0), 0.0), 5), error, 8)
    assert_allclose(found, [[1 / 3] * 3, [1 / 15] * 3], rtol=1e-12)


def test_a_code_word_is_two_control_samples_at_least_and_as_long_as_a_run_at_most():
    for word_s in (0.0016, 0.002, 3.0, 3.0004):
        assert words_asked(MARGIN, word_s, LOOP.parts, SPAN) is not None
    for word_s in (0.0014, 3.0006):
        with pytest.raises(
            ValueError, match=r"has less than two control samples|is longer than a run, of which 3 s are"
        ):
            words_asked(MARGIN, word_s, LOOP.parts, SPAN)
