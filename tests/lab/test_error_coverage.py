"""Known truths: their simulation and the bound of their errors against closed forms; identified by `make endurance`."""

import math
import os
import re
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

import truths
from microrad.lab.identify.hysteresis.prandtl_ishlinskii import threshold_grid
from places import ROOT, benchmark

coverage = benchmark("error_coverage")

ROUNDING = 1e-9
LAGS = [f"lag {i}" for i in range(len(coverage.LAGS_S))]
RECORD = coverage.RECORDS[3]  # fast loops: a delay, a rate and a resonance all show in it


# ---- the bound
def test_bound_of_a_line_is_that_of_the_textbook():
    """Slope of a line with a free offset: sigma^2 over the sum of squares about the mean; over two records, both."""
    time = np.arange(50.0)
    one = coverage.cramer_rao([time[:, None]], 0.3)
    assert one[0, 0] == pytest.approx(0.3**2 / np.sum((time - time.mean()) ** 2), rel=ROUNDING)
    assert one[0, 0] == pytest.approx(0.3**2 * 12 / (50 * (50**2 - 1)), rel=ROUNDING)
    assert coverage.cramer_rao([time[:, None]] * 2, 0.3)[0, 0] == pytest.approx(one[0, 0] / 2, rel=ROUNDING)


@pytest.mark.promise("identify-31")
def test_bound_of_a_sine_is_that_of_the_textbook():
    """Amplitude A and phase of a sine over whole periods, in units that differ by 1e6: 2 sigma^2/N, over A^2."""
    turns, amplitude = 2 * np.pi * np.arange(1000) / 100, 3e-6
    covariance = coverage.cramer_rao([np.column_stack([np.sin(turns), amplitude * np.cos(turns)])], 1e-7)
    assert covariance[0, 0] == pytest.approx(2 * 1e-14 / 1000, rel=ROUNDING, abs=0.0)
    assert covariance[1, 1] == pytest.approx(2 * 1e-14 / 1000 / amplitude**2, rel=ROUNDING, abs=0.0)
    assert abs(covariance[0, 1]) < ROUNDING * math.sqrt(covariance[0, 0] * covariance[1, 1])


def test_errors_of_functions_of_correlated_values():
    """Of a difference and of a quotient, to first order."""
    covariance = np.array([[4.0, 1.9], [1.9, 1.0]])
    values = {"a": 20.0, "b": 5.0}
    apart = coverage.error_of(lambda v: v["a"] - v["b"], values, ("a", "b"), covariance)
    assert apart == pytest.approx(math.sqrt(4.0 + 1.0 - 2 * 1.9), rel=1e-6)
    quotient = coverage.error_of(lambda v: v["a"] / v["b"], values, ("a", "b"), covariance)
    assert quotient == pytest.approx(4.0 * math.sqrt(0.1**2 + 0.2**2 - 2 * 1.9 / 100), rel=1e-6)


# ---- the truths
@pytest.mark.promise("identify-31")
@pytest.mark.parametrize("seed", [0, 1])
def test_truth_is_what_slower_twins_say(seed):
    """Hysteresis, resonance, creep and delay of a truth, by the oracles of the tests from the delayed drive."""
    truth = coverage.draw_truth(seed)
    truth = replace(truth, values={**truth.values, **dict.fromkeys(LAGS, 1e-6), "delay": 33e-6})
    v, rate_hz = truth.values, RECORD.rate_hz
    drive = RECORD.samples(33e-6)
    assert np.abs(drive - RECORD.samples()).max() > 0.04  # 64 Hz, 4 V
    if truth.family == "plays":
        strain = truths.plays(drive, coverage.THRESHOLDS_V, [v[f"weight {i}"] for i in range(15)])
    else:
        strain = truths.bouc_wen(drive, rate_hz, [v[k] for k in ("d1", "d2", "epsilon", "delta", "alpha", "beta")])
    expected = truths.behind_resonance(strain, rate_hz, (v["resonance"], v["damping"]))
    expected += truths.creep(drive, rate_hz, coverage.LAGS_S, 1e-6)
    assert coverage.simulated(truth, RECORD, 1) == pytest.approx(expected, abs=1e-5 * np.ptp(expected))
    assert coverage.simulated(truth, RECORD) == pytest.approx(expected, abs=1e-3 * np.ptp(expected))


@pytest.mark.parametrize("beta", [2.0, -2.0])
def test_bouc_wen_of_the_truth_for_either_sign(beta):
    """Loops within loops, h through zero in both directions, epsilon of either sign."""
    drive = truths.two_sines(300, 200.0)
    for epsilon in (-0.03, 0.02):
        values = {"d1": 0.08, "d2": 1e-4, "epsilon": epsilon, "delta": 1e-3, "alpha": 5.0, "beta": beta}
        twin = truths.bouc_wen(drive, 200.0, list(values.values()), pieces=100)
        found = coverage.bouc_wen(drive - coverage.REST_V, 1 / 200.0, values)
        assert np.ptp(twin - 0.08 * (drive - drive[0])) > 1e-3  # there is hysteresis
        assert found == pytest.approx(twin, abs=1e-8)


# ---- what is said of them
def judged(off, error=1.0, name="damping"):
    return coverage.Judged(0, name, 10.0, 10.0 + off * error, error, 0.5)


@pytest.mark.promise("identify-31")
def test_line_of_the_table_counts_what_is_known_and_what_is_held():
    rows = (judged(0.5), judged(-1.9), judged(2.0), judged(0.0, 11.0), judged(0.0, math.nan))
    line = coverage.Line("damping", rows)
    assert len(line.known) == 3  # neither without an error, nor with one above its size
    assert line.held[0] == pytest.approx(2 / 3)
    assert line.held[1:] == pytest.approx((0.0943, 0.9916), abs=1e-4)  # Clopper and Pearson
    assert line.width == 2.0
    assert line.missed == ("too few known",)
    assert str(line) == "damping                       5    60%    67%    9 to  99 %    2.00  too few known"


@pytest.mark.promise("identify-31")
@pytest.mark.parametrize(
    ("offs", "error", "missed"),
    [
        ([0.0] * 94 + [3.0] * 6, 1.0, ()),
        ([0.0] * 80 + [3.0] * 20, 1.0, ("errors too small",)),
        ([0.0] * 1000, 1.0, ("errors too large",)),
        ([0.0] * 94 + [3.0] * 6, 1.1, ("too wide",)),
    ],
)
def test_line_names_the_bar_that_it_misses(offs, error, missed):
    assert coverage.Line("damping", tuple(judged(off, error) for off in offs)).missed == missed


def test_table_takes_weights_together_and_the_residual_apart():
    rows = tuple(judged(0.0, name=n) for n in ("weight 0", "weight 3", "weight 4", coverage.RESIDUAL))
    result = coverage.Result(coverage.draw_truth(0), rows, "prandtl_ishlinskii_joint", (), (), 1.0)
    lines = coverage.lines_of([result, result])
    assert [(line.name, len(line.rows)) for line in lines] == [
        ("weight 0", 2),
        ("weights above 0 V", 4),
        (coverage.RESIDUAL, 2),
        ("all parameters", 6),
    ]


@pytest.mark.promise("decisions-1")
def test_the_page_of_decisions_has_the_line_of_the_table():
    decisions, identify = (
        (ROOT / "docs" / f"{name}.md").read_text(encoding="utf-8") for name in ("decisions", "identify")
    )
    count, share = re.search(r"\| \*\*all parameters\*\* \| (\d+) \| 100 % \| (\d+ %) ", identify).groups()
    assert f"{share} of {count} parameters within 1.96 of their errors" in decisions


@pytest.mark.promise("identify-56")
def test_the_lines_of_the_page_belong_together():
    """Each interval is that of some number of cases that rounds to the share; all parameters are those above them."""
    page = (ROOT / "docs" / "identify.md").read_text(encoding="utf-8")
    row = r"(?m)^\| (.*?) \| (\d+) \| (\d+) % \| (\d+) % \((\d+) to (\d+)\) \| ([\d.]+) \|$"
    *parts, (_, *whole) = [(name, *map(float, cells)) for name, *cells in re.findall(row, page)]
    assert len(parts) == len({name for name, *_ in parts}) == 14
    for name, cases, known, held, low, high, width in [*parts, ("all", *whole)]:
        with_error = round(cases * known / 100.0)
        ends = [
            tuple(round(100 * end) for end in stats.binomtest(k, with_error).proportion_ci(method="exact"))
            for k in range(with_error + 1)
            if abs(100.0 * k / with_error - held) <= 0.5
        ]
        assert (low, high) in ends, name
        assert known >= 80.0 and 1.0 < width < 2.0
    assert sum(cases for name, cases, *_ in parts if not name.startswith("residual")) == whole[0]
    below = {name for name, _, _, held, *_ in parts if not 90.0 <= held <= 99.0}
    assert below == {"d1", "delta"}


@pytest.mark.promise("identify-57")
def test_the_models_were_true_but_for_the_noise():
    assert coverage.THRESHOLDS_V.tolist() == threshold_grid(coverage.SPAN_V, 15).tolist()
    np.testing.assert_allclose(np.diff(np.log10(coverage.LAGS_S)), 1.0)
    for seed in range(6):
        models = coverage.FAMILIES[coverage.draw_truth(seed).family]
        assert len({name.partition("_")[0] for name in models}) == 1


# ---- a few of them identified
@pytest.mark.promise("decisions-1")
@pytest.mark.endurance
@pytest.mark.parametrize("seed", [32, 12])
def test_known_truth_is_found_within_its_errors(seed):
    """Plays with creep and a delay, and with a delay: each number within four of its errors."""
    found = coverage.judged(coverage.draw_truth(seed))
    by = {each.name: each for each in found.judged}
    assert {"resonance", "damping", "delay", "gain of large drives", coverage.RESIDUAL} <= set(by)
    assert ("creep a decade" in by) == found.chosen.endswith("creep") == (seed == 32)
    assert len(found.poles_hz) == 1  # the one that there is
    for each in found.judged:
        assert 0.0 < each.bound < math.inf
        assert each.known, each
        assert abs(each.off) < 4.0, each
    assert 0.5 < by["resonance"].error / by["resonance"].bound < 2.0


@pytest.mark.promise("identify-31")
@pytest.mark.promise("decisions-1")
@pytest.mark.promise("identify-53")
@pytest.mark.endurance
def test_all_truths_meet_the_bars():
    """As the benchmark prints it, with BLAS in one thread as the command line has it: no line misses a bar."""
    command, environment = [sys.executable, coverage.__file__], {**os.environ, "OPENBLAS_NUM_THREADS": "1"}
    ran = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert ran.returncode == 0, ran.stdout + ran.stderr
    assert len(ran.stdout.splitlines()) > coverage.TRUTHS
