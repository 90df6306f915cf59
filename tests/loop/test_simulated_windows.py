"""Error indices of simulated runs: against all samples of each run at once, exact theory, and what is refused."""

import math
from dataclasses import replace
from functools import reduce
from itertools import pairwise

import numpy as np
import pytest
from numpy.testing import assert_allclose

from microrad.loop.disturbance import Disturbance, SpectralLine, first_order
from microrad.loop.disturbance.windows import ErrorIndex
from microrad.loop.pointing_loop import ensemble
from microrad.loop.pointing_loop import simulated_windows as simulation
from microrad.loop.pointing_loop.ensemble import Span
from microrad.loop.pointing_loop.linear import close, residual_spectrum
from microrad.loop.pointing_loop.simulated_windows import (
    Question,
    Windows,
    ask,
    half_width,
    simulated_windows,
    windows_asked,
)
from microrad.loop.pointing_loop.traces import trace
from microrad.loop.pointing_loop.windows import windowed, windowed_in_all
from microrad.loop.workbench import Controller, Loop
from microrad.mirror.hysteresis import PrandtlIshlinskii
from microrad.mirror.model import Mirror

LIGHT = [1 / 3000**2, 2 * 0.1 / 3000, 1.0]
SLOW = first_order(160e-12, 5.0, convention="per-axis", name="vibration")
LINE = Disturbance(
    "wheel", np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), (SpectralLine(2e-6, 30.0),), "line", "test"
)
PLAIN = Loop(mirror=Mirror.of(50e-6, [1.0], LIGHT), rate_hz=1000.0, vibration=(SLOW, LINE), sensor_noise_rad=0.5e-6)
PLAYS = PrandtlIshlinskii(thresholds_v=(0.0, 0.2, 1.0), weights_rad_v=(30e-6, 12e-6, 8e-6))
BENT = Loop(
    mirror=Mirror.of(PLAYS, [1.0], LIGHT), rate_hz=1000.0, vibration=(SLOW, LINE), sensor_noise_rad=0.5e-6, delay_s=2e-4
)
TRACKING = Controller.pid(0.0, 5e5, rate_hz=1000.0)
SPAN = Span(5.3, 0.2, 1)
INDICES = (
    ErrorIndex("APE"),
    ErrorIndex("MPE", 0.007),
    ErrorIndex("RPE", 0.007),
    ErrorIndex("PDE", 0.007, 0.002),
    ErrorIndex("PDE", 0.007, 2.5),
    ErrorIndex("RPE", 2.5),
)


def simulated(loop, indices=INDICES, span=SPAN, runs=3, **settings):
    return simulated_windows(loop.parts, loop.assembled(TRACKING), indices, span, runs, **settings)


def of_all_samples(error, index):
    """Mean square of an index, from the whole run in memory."""
    if index.window_s is None:
        return np.mean(error**2)
    window, apart = round(index.window_s * 1000.0), round((index.spacing_s or 0.0) * 1000.0)
    starts = range(0, len(error) - window - apart + 1, window)
    parts = np.array([error[k : k + window] for k in starts])
    if index.kind == "RPE":
        return np.mean(np.var(parts, axis=1))
    mean = parts.mean(axis=1)
    if index.kind == "MPE":
        return np.mean(mean**2)
    return np.mean((np.array([error[k + apart : k + apart + window].mean() for k in starts]) - mean) ** 2)


@pytest.mark.promise("pointing-37", "pointing-38")
def test_slices_give_what_all_samples_of_each_run_give():
    """A window of 2.5 s is longer than a slice of 2048 samples, and the end of the settling is inside one."""
    runs = [trace(BENT.parts, BENT.assembled(TRACKING), SPAN, run).error_rad[200:, 0] for run in range(3)]
    for found in simulated(BENT):
        squares = np.array([of_all_samples(run, found.index) for run in runs])
        rms = math.sqrt(np.mean(squares))
        assert found.rms_rad == pytest.approx(rms, rel=1e-9, abs=0.0)
        assert_allclose(found.axis_rms_rad, [rms], rtol=1e-9)
        assert found.interval_rad == pytest.approx(
            9.925 * np.std(squares, ddof=1) / math.sqrt(3) / (2.0 * rms), rel=1e-3, abs=0.0
        )  # Student's t of two degrees of freedom


def test_windows_that_stand_behind_each_other_are_summed_over_any_slices():
    values = np.arange(40.0).reshape(20, 2)
    for length, begin in ((1, 0), (3, 0), (7, 4), (20, 0), (9, 19)):
        wanted = [values[k : k + length].sum(axis=0) for k in range(begin, 21 - length, length)]
        for cuts in ((0, 20), (0, 1, 2, 9, 20), (0, 5, 10, 15, 20)):
            windows = Windows(length, begin)
            found = [each for first, last in pairwise(cuts) for each in windows.add(first, values[first:last])]
            assert_allclose(np.array(found).reshape(-1, 2), np.array(wanted).reshape(-1, 2), rtol=1e-15)


def test_the_threads_do_not_matter_and_the_seed_does():
    one, four = (simulated(BENT, runs=130, span=Span(0.5, 0.1, 1), indices=INDICES[:3], threads=n) for n in (1, 4))
    other = simulated(BENT, runs=130, span=Span(0.5, 0.1, 2), indices=INDICES[:3])
    for a, b, c in zip(one, four, other, strict=True):
        assert (a.rms_rad, a.interval_rad, a.linear_rad) == (b.rms_rad, b.interval_rad, b.linear_rad)
        assert (a.rms_rad, a.linear_rad) != (c.rms_rad, c.linear_rad) and a.linear_rad == c.linear_rad


def test_runs_without_hysteresis_are_linear_theory_and_those_with_it_are_not():
    """The line and the vibration move slowly: 2.5 s hold few of their periods, and their interval is the widest."""
    for found in simulated(PLAIN, runs=64):
        assert abs(found.rms_rad - found.linear_rad) < 1.5 * found.interval_rad < 0.2 * found.rms_rad
    slow = replace(PLAIN.parts, optical=replace(PLAIN.parts.optical, every=3))
    in_readings = (
        ErrorIndex("APE"),
        *(ErrorIndex(kind, 0.009) for kind in ("MPE", "RPE")),
        ErrorIndex("PDE", 0.009, 0.006),
    )
    for found in simulated_windows(slow, PLAIN.assembled(TRACKING), in_readings, SPAN, 64):
        assert abs(found.rms_rad - found.linear_rad) < 1.5 * found.interval_rad < 0.1 * found.rms_rad
    bent = simulated(BENT, runs=64, indices=INDICES[:3])
    assert any(abs(found.rms_rad - found.linear_rad) > 2.0 * found.interval_rad for found in bent)


@pytest.mark.promise("pointing-38")
def test_theory_at_the_samples_is_the_spectrum_there_under_the_weight_of_their_mean():
    """(sin(N x) / (N sin x))^2 of N samples, x = pi f T; the spectrum of the residual is that of the samples, too."""
    loop = replace(PLAIN, vibration=SLOW)
    closed = close(loop.parts, loop.assembled(TRACKING))
    # A sum over all frequencies of a period is exact but for correlations that are longer than it: 100 s.
    freq_hz = (np.arange(50_000) + 0.5) / 100.0
    density = residual_spectrum(closed, freq_hz)[:, 0] / 100.0
    x = np.pi * freq_hz / 1000.0
    mean = (np.sin(7 * x) / (7 * np.sin(x))) ** 2
    apart = 4.0 * np.sin(2 * x) ** 2
    for index, weight in zip(INDICES, (np.ones_like(x), mean, 1.0 - mean, apart * mean), strict=False):
        found = windowed_in_all(closed, index, at_samples=True)
        assert_allclose(found, [np.sum(weight * density)], rtol=1e-6)
        assert abs(windowed_in_all(closed, index) / found - 1.0) > 1e-4


def test_a_line_at_the_samples_is_what_a_run_without_noise_repeats_there():
    loop = replace(PLAIN, vibration=LINE, sensor_noise_rad=0.0)
    closed = close(loop.parts, loop.assembled(TRACKING))
    error = trace(loop.parts, loop.assembled(TRACKING), Span(3.0, 0.0, 1)).error_rad[-100:, 0]  # three periods
    means = np.mean([np.roll(error, k) for k in range(7)], axis=0)
    for index, square in zip(INDICES, (error**2, means**2, error**2 - means**2), strict=False):
        found = windowed_in_all(closed, index, at_samples=True)
        assert_allclose(found, [np.mean(square)], rtol=1e-6)
        assert abs(windowed_in_all(closed, index) / found - 1.0) > 1e-4


def test_theory_at_the_samples_is_theory_at_all_plant_steps_where_each_sample_has_one():
    loop = replace(PLAIN, steps_per_sample=1)
    closed = close(loop.parts, loop.assembled(TRACKING))
    for index in INDICES:
        at_all_steps = sum(windowed(closed, index).values())
        assert_allclose(windowed_in_all(closed, index, at_samples=True), at_all_steps, rtol=1e-12)


def drawn_loop(number):
    """A loop and a PI that keeps it stable, settled to e^-20 behind a thousand samples, of a seed of its own."""
    rng = np.random.default_rng([20, number])
    while True:
        rate = 10.0 ** rng.uniform(2.5, 4.0)
        modes = [2.0 * math.pi * rate * rng.uniform(0.05, 1.0) for _ in range(rng.integers(1, 3))]
        forms = [[1 / w**2, 2 * 10.0 ** rng.uniform(-2.0, 0.0) / w, 1.0] for w in modes]
        share = rng.uniform(0.2, 0.8)
        light = np.ones(1) if len(forms) == 1 else share * np.array(forms[1]) + (1.0 - share) * np.array(forms[0])
        steps, gain, line = int(rng.choice([1, 2, 5])), 10.0 ** rng.uniform(-6.0, -4.0), ()
        step = 1.0 / rate / steps
        if rng.random() < 0.3:
            wheel = SpectralLine(10.0 ** rng.uniform(-7.0, -5.5), rate * rng.uniform(0.01, 0.4))
            line = (replace(LINE, lines=(wheel,)),)
        level, corner = 10.0 ** rng.uniform(-14.0, -10.0), rate * 10.0 ** rng.uniform(-3.5, -1.0)
        loop = Loop(
            mirror=Mirror.of(gain, light.tolist(), reduce(np.polymul, forms)),
            rate_hz=rate,
            vibration=(first_order(level, corner, convention="per-axis", name="vibration"), *line),
            sensor_noise_rad=10.0 ** rng.uniform(-7.5, -5.5),
            delay_s=int(rng.integers(0, 2 * steps + 1)) * step,
            sensor_delay_s=int(rng.integers(0, steps + 1)) * step,
            steps_per_sample=steps,
        )
        proportional, integral = rng.uniform(0.0, 0.5) / gain, 10.0 ** rng.uniform(-2.0, -0.3) / gain * rate
        controller = loop.assembled(Controller.pid(proportional, integral, rate_hz=rate))
        if close(loop.parts, controller).worst_pole()[0] < 0.98:
            return loop.parts, controller


def missed(number, off=1.0):
    """Which indices of a drawn loop have exact theory, so many times as large, outside the interval of 64 runs."""
    loop, controller = drawn_loop(number)
    period = loop.timing.period_s
    times = [10.0 ** np.random.default_rng([21, number]).uniform(0.5, 2.0) * period for _ in range(2)]
    indices = [ErrorIndex("APE"), *(ErrorIndex(kind, times[0]) for kind in ("MPE", "RPE")), ErrorIndex("PDE", *times)]
    found = simulated_windows(loop, controller, indices, Span(7000 * period, 1000 * period, number), 64)
    assert all(each.interval_rad < 0.1 * each.rms_rad for each in found)
    return [abs(each.rms_rad - off * each.linear_rad) > each.interval_rad for each in found]


@pytest.mark.promise("pointing-43")
@pytest.mark.parametrize("loops", [6, *(pytest.param(loops, marks=pytest.mark.endurance) for loops in (200, 1000))])
def test_exact_theory_lies_in_the_intervals_of_runs_of_random_loops(loops):
    """An interval of 99 % misses once in a hundred, so that misses of an index are binomial in the loops drawn.

    Each index has to lie in the middle 99.8 % of that: 0 to 2 of 6 loops, 0 to 8 of 200, 2 to 21 of 1000. The loops are
    independent of each other, the indices of a loop are not.
    """
    from scipy.stats import binom

    misses = np.sum([missed(number) for number in range(loops)], axis=0)
    fewest, most = binom.ppf([0.001, 0.999], loops, 0.01)
    assert np.all((fewest <= misses) & (misses <= most)), misses


def test_theory_that_is_a_tenth_off_lies_outside_of_them():
    assert np.all([missed(number, off) for number, off in enumerate((0.9, 1.1))])


@pytest.mark.promise("pointing-38")
def test_one_run_has_no_interval_and_the_share_of_many_is_student_s():
    assert half_width(np.ones(1)) == math.inf and half_width(np.ones(2)) == 0.0
    assert half_width(np.array([0.0, 2.0])) == pytest.approx(63.657, rel=1e-4, abs=0.0)


@pytest.mark.promise("pointing-38")
@pytest.mark.parametrize(
    ("index", "runs", "span", "words"),
    [
        (INDICES[0], 0, SPAN, "0 runs leave no errors: ask for 1 run or more"),
        (ErrorIndex("MPE", 0.001), 2, SPAN, "MPE over 1 ms looks at one control sample of a run"),
        (ErrorIndex("RPE", 6.0), 2, SPAN, "RPE looks at 6 s of a run, and 5.1 s are left behind its settling"),
        (ErrorIndex("PDE", 0.1, 5.1), 2, SPAN, "PDE looks at 5.2 s of a run"),
        (INDICES[0], 2, Span(0.1, 0.2, 1), "nothing left behind a settling time of 0.2 s"),
        (ErrorIndex("MPE", 1e-5), 2, SPAN, "and the sensor reads every 0.001 s: give more"),
    ],
)
def test_what_no_run_can_have_is_refused(index, runs, span, words):
    with pytest.raises(ValueError, match=words) as refused:
        simulated(PLAIN, (index,), span, runs)
    assert "\n" not in str(refused.value)


def test_several_questions_are_asked_of_the_same_runs_at_once():
    parts, controller = BENT.parts, BENT.assembled(TRACKING)
    one, other = (windows_asked(parts, controller, indices, SPAN) for indices in (INDICES[:2], INDICES[2:3]))
    together = ask([one, other], parts, controller, SPAN, 3)
    apart = simulated(BENT, INDICES[:2]), simulated(BENT, INDICES[2:3])
    for left, right in zip(together, apart, strict=True):
        assert [each.rms_rad for each in left] == [each.rms_rad for each in right]


class Last:
    """The error of each axis at the last control sample that it has heard of, which it numbers."""

    def __init__(self, number):
        self.number, self.heard = number, 0

    def add(self, at, error):
        assert at == self.heard
        self.heard, self.last = at + len(error), error[-1]

    @property
    def mean(self):
        return np.vstack([self.last, np.full(self.last.shape[1], self.number)])


def test_questions_at_once_hear_their_own_tallies_and_that_of_a_second_terminal_the_runs_behind_all_of_the_first():
    """65 runs take two batches of 64: the second terminal's are those from number 128 on."""
    parts, controller, span, told = PLAIN.parts, PLAIN.assembled(TRACKING), Span(0.05, 0.01, 3), []
    asked = [
        Question(lambda: [Last(1), Last(2)], lambda found: ("two", found)),
        Question(lambda: [Last(3)], lambda found: ("twin", found), twin=True),
        Question(lambda: [Last(4)], lambda found: ("one", found)),
    ]
    answers = ask(asked, parts, controller, span, 65, threads=1, on_progress=lambda *each: told.append(each))
    assert [name for name, _ in answers] == ["two", "twin", "one"]
    (a, b), (twin,), (one,) = (found for _, found in answers)
    assert [each[:, -1].tolist() for each in (a, b, twin, one)] == [[number] * 65 for number in (1, 2, 3, 4)]
    assert [each.shape for each in (a, b, twin, one)] == [(65, 2), (65, 2), (65, 3), (65, 2)]
    for run in (0, 63, 64):
        own, other = (trace(parts, controller, span, number).error_rad[-1, 0] for number in (run, 128 + run))
        assert [each[run, 0] for each in (a, b, twin, one)] == [own] * 4
        assert twin[run, 1] == other != own
    assert told == [(64, 65, "simulating windows"), (65, 65, "simulating windows")]


def test_runs_are_held_against_the_theory_of_the_loop_that_is_given_for_it():
    parts, controller, span = BENT.parts, BENT.assembled(TRACKING), Span(0.3, 0.1, 1)
    stiff = replace(parts, mirror=Mirror.of(80e-6, [1.0], LIGHT))
    own, other = (
        ask([windows_asked(parts, controller, INDICES[:2], span, theory)], parts, controller, span, 2)[0]
        for theory in (None, stiff)
    )
    assert [each.rms_rad for each in own] == [each.rms_rad for each in other]
    for each, theory in ((own, parts), (other, stiff)):
        closed = close(theory, controller)
        expected = [math.sqrt(float(np.sum(windowed_in_all(closed, i, at_samples=True)))) for i in INDICES[:2]]
        assert [e.linear_rad for e in each] == pytest.approx(expected, rel=1e-12)
    assert other[0].linear_rad < 0.99 * own[0].linear_rad


@pytest.mark.parametrize("index", [ErrorIndex("PDE", 0.001, 0.004), ErrorIndex("RPE", 0.0012), ErrorIndex("MPE", 6e-4)])
def test_a_window_of_one_control_sample_is_refused_with_and_without_a_spacing(index):
    with pytest.raises(ValueError) as refused:
        simulated(PLAIN, (INDICES[0], index))
    assert str(refused.value) == (
        f"{index.kind} over 1 ms looks at one control sample of a run: give a window of two or more"
    )


def test_a_window_may_fill_a_run_and_a_loop_in_which_nothing_moves_has_no_interval():
    still = replace(PLAIN, vibration=(), sensor_noise_rad=0.0)
    index, span = ErrorIndex("RPE", 0.04), Span(0.05, 0.01, 1)
    (found,) = simulated(PLAIN, (index,), span, 2)
    squares = [of_all_samples(trace(PLAIN.parts, PLAIN.assembled(TRACKING), span, run).error_rad[10:, 0], index)
               for run in (0, 1)]  # fmt: skip
    assert found.rms_rad == pytest.approx(math.sqrt(np.mean(squares)), rel=1e-9)
    (nothing,) = simulated(still, (index,), span, 2)
    assert (nothing.rms_rad, nothing.interval_rad, nothing.linear_rad) == (0.0, 0.0, 0.0)
    with pytest.raises(ValueError, match="PDE looks at 41 ms of a run, and 40 ms are left behind its settling"):
        simulated(PLAIN, (ErrorIndex("PDE", 0.011, 0.03),), span, 2)


@pytest.mark.parametrize("threads", [None, 3])
def test_runs_are_shared_out_to_the_threads_that_are_asked_for(monkeypatch, threads):
    asked, span = [], Span(0.02, 0.005, 1)

    def in_threads(jobs, tell=None, workers=None):
        asked.append((len(jobs), workers))
        return [job() for job in jobs]

    for module in (simulation, ensemble):
        monkeypatch.setattr(module, "in_threads", in_threads)
    simulated(PLAIN, INDICES[:1], span, 65, threads=threads)
    ensemble.simulate(PLAIN.parts, PLAIN.assembled(TRACKING), span, 130, threads=threads)
    assert asked == [(2, threads), (3, threads)]


@pytest.mark.parametrize(("known", "pointed"), [("AKE", "APE"), ("MKE", "MPE"), ("RKE", "RPE")])
def test_what_is_known_counts_in_runs_as_what_is_pointed(known, pointed):
    error = np.random.default_rng(9).standard_normal((60, 2, 3))
    window = 0 if known == "AKE" else 7
    times = () if known == "AKE" else (0.007,)
    found = []
    for kind in (known, pointed):
        tally = simulation._Squares(ErrorIndex(kind, *times), window, 0)
        for at in (0, 25, 50):
            tally.add(at, error[at : at + 25])
        found.append(tally.mean)
    assert found[0].tolist() == found[1].tolist()
    windows = error[:56].reshape(8, 7, 2, 3)
    by_hand = {
        "APE": np.mean(error**2, axis=0),
        "MPE": np.mean(np.mean(windows, axis=1) ** 2, axis=0),
        "RPE": np.mean(np.var(windows, axis=1), axis=0),
    }
    assert_allclose(found[0], by_hand[pointed], rtol=1e-12)
