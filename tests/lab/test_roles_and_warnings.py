"""What a recording serves for, judged by its drive, and what speaks against a model."""

import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.signal import lfilter

import truths
from microrad.lab.identify import identify
from microrad.lab.identify.selection import warnings
from microrad.lab.identify.selection.predictions import Prediction, Score
from microrad.lab.identify.selection.roles import is_broadband, roles, whole_periods
from microrad.lab.identify.selection.warnings import ResidualTest, residual_test, residual_warnings
from microrad.lab.recording import Recording
from truths import philox

TIME = np.arange(8000) / 2000.0


def recording(drive, rate_hz=2000.0, period=None, name="record"):
    column = np.asarray(drive)[:, None]
    return Recording(name, name, column, column.copy(), rate_hz, ("u",), ("y",), period)


def chirp(amplitude=1.0, first=1.0, last=800.0):
    growth = np.log(last / first) / TIME[-1]
    return amplitude * np.sin(2 * np.pi * first / growth * np.expm1(growth * TIME))


def multisine(amplitude, highest=800, seed=1):
    f = np.arange(4001) / 4.0
    lines = np.where((f >= 1) & (f <= highest), np.exp(2j * np.pi * philox(seed).random(f.size)), 0.0)
    signal = np.fft.irfft(lines)
    return amplitude * signal / np.abs(signal).max()


SINE = 5 * np.sin(2 * np.pi * 7 * TIME)
STAIRCASE = np.interp(
    TIME,
    np.sort([*np.arange(0, 4, 0.5), *(np.arange(0.5, 4, 0.5) + 0.005)]),
    np.repeat([0, 3, 5, 2, -3, -5, 0, 4], 2)[1:],
)
LOOPS = {
    "sine": SINE,
    "growing sine": SINE * np.repeat([0.2, 0.4, 0.7, 1.0], 2000),
    "triangle": 5 * (2 * np.abs((3 * TIME) % 1 * 2 - 1) - 1),
    "staircase": STAIRCASE,
    "sine with noise": SINE + 1e-3 * philox(2).standard_normal(TIME.size),
    "half a decade of multisine": multisine(5.0, highest=4),
}
WIDE = {"chirp": chirp(), "small multisine": multisine(0.3), "noise": philox(1).standard_normal(TIME.size)}


# --------------------------------------------------------------------------------------------------------------- roles
@pytest.mark.promise("identify-3")
@pytest.mark.parametrize("name", LOOPS)
def test_loops_are_not_broadband(name):
    assert not is_broadband(recording(LOOPS[name]))


@pytest.mark.promise("identify-3")
@pytest.mark.parametrize("name", WIDE)
def test_broadband_drives_are_told(name):
    assert is_broadband(recording(WIDE[name]))
    assert is_broadband(recording(3.0 + 1e-4 * WIDE[name]))  # neither offset nor size matter


@pytest.mark.promise("identify-3")
def test_a_small_broadband_record_is_for_the_linear_part_and_a_large_one_is_a_loop():
    sine, small, large = recording(SINE), recording(multisine(0.3)), recording(multisine(5.0))
    found = roles([sine, small, large])
    assert found.broadband == [small]
    assert found.response == [small]
    assert found.loops == [sine, large]


@pytest.mark.promise("identify-3")
@pytest.mark.parametrize(("size", "small"), [(0.49, True), (0.51, False)])
def test_small_is_at_most_half_of_the_largest_drive(size, small):
    sine = recording(SINE)
    wide = multisine(1.0)
    record = recording(size * np.ptp(SINE) * wide / np.ptp(wide))
    assert roles([sine, record]).broadband == ([record] if small else [])


@pytest.mark.promise("identify-3")
def test_where_all_records_are_broadband_they_are_loops_too():
    small, large = recording(multisine(0.3)), recording(multisine(5.0))
    found = roles([small, large])
    assert found.broadband == [small, large]
    assert found.loops == [small, large]
    assert roles([recording(SINE)]) == ([], [], roles([recording(SINE)]).loops) or not roles([recording(SINE)]).response


@pytest.mark.promise("identify-3")
def test_the_highest_rate_wins_and_a_periodic_record_goes_before_a_chirp():
    sine = recording(SINE)
    slow = recording(multisine(0.3), rate_hz=1000.0, period=8000)
    fast_chirp, fast_periodic = recording(chirp(0.3)), recording(multisine(0.3), period=8000)
    twin = recording(multisine(0.3, seed=9), period=8000)
    assert roles([sine, slow, fast_chirp]).response == [fast_chirp]
    assert roles([sine, fast_chirp, fast_periodic, slow, twin]).response == [fast_periodic, twin]
    assert roles([sine, slow]).response == [slow]


def test_a_part_of_a_periodic_record_is_cut_to_whole_periods():
    whole = recording(np.tile(multisine(1.0)[:1000], 4), period=1000)
    cut = whole_periods(replace(whole, drive=whole.drive[:2700], output=whole.output[:2700]))
    assert (cut.samples, cut.period_samples) == (2000, 1000)
    short = whole_periods(replace(whole, drive=whole.drive[:1700], output=whole.output[:1700]))
    assert (short.samples, short.period_samples) == (1700, None)


# ----------------------------------------------------------------------------------------------------------- residuals
def brute_force(a, b, lags):
    size = math.sqrt(sum(v * v for v in a) * sum(v * v for v in b))
    return [sum(a[k] * b[k - lag] for k in range(lag, len(a))) / size for lag in range(lags + 1)]


@pytest.mark.promise("identify-28")
def test_the_residual_test_is_what_it_says():
    residual, drive = 2.0 + philox(3).standard_normal(300), 5.0 + philox(4).standard_normal(300)
    test = residual_test(residual, drive)
    centred = residual - residual.mean()
    assert_allclose(test.autocorrelation, brute_force(centred, centred, 50)[1:], rtol=1e-9)
    assert (test.samples, test.bound) == (300, 1.96 / math.sqrt(300))

    order = 15  # a twentieth of the samples
    r = [float(centred[k:] @ centred[: 300 - k]) for k in range(order + 1)]
    matrix = np.array([[r[abs(i - j)] for j in range(order)] for i in range(order)])
    whitener = [1.0, *(-np.linalg.solve(matrix, r[1:]))]
    white = [sum(whitener[j] * centred[k - j] for j in range(order + 1)) for k in range(order, 300)]
    moved = drive - drive.mean()
    input_ = [sum(whitener[j] * moved[k - j] for j in range(order + 1)) for k in range(order, 300)]
    assert_allclose(test.cross_correlation, brute_force(white, input_, 50), atol=1e-7)


@pytest.mark.promise("identify-28")
def test_noise_passes_and_colour_does_not():
    noise, drive = philox(5).standard_normal((2, 20_000))
    shares = [residual_test(philox(s).standard_normal(5000), drive[:5000]).outside for s in range(20)]
    assert 0.03 < np.mean(shares) < 0.07  # 5 % of what is noise lies outside
    white = residual_test(noise, drive)
    assert white.white
    assert white.independent
    assert residual_warnings(white) == []

    coloured = residual_test(lfilter([1], [1, -0.8], noise), drive)
    assert not coloured.white
    assert coloured.independent  # colour alone does not follow the drive
    (text,) = residual_warnings(coloured)
    assert f"not white: {100 * coloured.outside[0]:.0f} % of its correlations over 50 samples" in text

    followed = residual_test(noise + 0.1 * lfilter([0, 1, 0.9, 0.8, 0.7, 0.6, 0.5, 0.4], [1], drive), drive)
    assert not followed.independent
    assert np.argmax(np.abs(followed.cross_correlation)) == 1
    assert any("a better model of these recordings exists" in text for text in residual_warnings(followed))


@pytest.mark.promise("identify-28")
def test_a_smooth_drive_gives_false_alarms_now_and_then():
    """Neighbouring lags of a sine say the same: A^2 of its two phases is chi-square, and 15 % exceed 1.96^2."""
    alarms = [not residual_test(philox(s).standard_normal(1000), SINE[:1000]).independent for s in range(1000)]
    assert 1 / 15 < np.mean(alarms) < 1 / 10  # about once in twelve


def test_a_residual_of_zeros_is_no_reason_to_stop():
    test = residual_test(np.zeros(200), philox(1).standard_normal(200))
    assert test.white
    assert test.independent


@pytest.mark.promise("identify-28")
def test_shares_outside_are_counted():
    test = ResidualTest(100, 0.2, np.array([0.3, 0.1, -0.3, 0.0]), np.array([0.1, -0.25]))
    assert test.outside == (0.5, 0.5)
    assert not (test.white or test.independent)
    for outside, passes in ((5, True), (6, False)):  # of fifty, a tenth
        found = np.where(np.arange(50) < outside, 0.3, 0.1)
        assert ResidualTest(100, 0.2, found, np.zeros(51)).white == passes
        assert ResidualTest(100, 0.2, np.zeros(50), found).independent == passes


# ------------------------------------------------------------------------------------------------------------ warnings
def test_drift_of_a_record_and_its_error():
    noise = 1e-6 * philox(8).standard_normal(2000)
    trend = np.linspace(0.0, 2e-5, 2000)
    quiet, moving = (Prediction(np.zeros(2000), noise + extra, 0, 1000, 0) for extra in (0.0, trend))
    record = recording(SINE[:2000])
    largest, found = warnings.drift([quiet, moving], [record, record], 1e-3)
    assert largest == pytest.approx(2e-5, rel=0.05)
    assert len(found) == 1
    assert "drifts by 20" in found[0]
    assert "2 % of the peak-to-peak output) in 1 s" in found[0]
    assert warnings.drift([quiet], [record], 1e-3)[1] == []
    assert warnings.drift([moving], [record], 1.0)[1] == []  # significant, and of no consequence


def test_scores_that_speak_against_a_model():
    line, good = Score("straight line", 2.0, 5.0, 2.0, 5.0), Score("m", 1.0, 3.0, 1.1, 3.0)
    assert warnings.score_warnings(good, line) == []
    (worse,) = warnings.score_warnings(replace(good, held_out_rms_percent=1.6), line)
    assert "grows from 1.00 % on the fitted samples to 1.60 %" in worse
    assert "No model is better than a straight line" in warnings.score_warnings(Score("m", 1.9, 3.0, 2.1, 3.0), line)[0]


def test_held_out_samples_beyond_the_fitted_drives_are_counted():
    record = recording(np.concatenate([np.linspace(0, 10, 100), [10.1, 10.3, -0.5], np.zeros(97)]))
    seen = Prediction(np.zeros(200), np.zeros(200), 0, 100, 0)
    from microrad.lab.identify import Units

    (text,) = warnings.held_out_warnings([record], Units(), (0.0, 10.0), [seen])
    assert text.startswith("2 held-out samples")  # 10.1 is within the margin of 2 %
    assert warnings.held_out_warnings([record], Units(), (-1.0, 11.0), [seen]) == []


@pytest.mark.promise("identify-26")
def test_a_search_that_did_not_settle_is_told():
    drive = truths.two_sines()
    result = identify(
        [truths.recorded(drive, truths.plays(drive, [0, 0.8], [8e-5, 2e-5]))], models=("prandtl_ishlinskii_rate",)
    )
    fit = result.fit()
    assert fit.fit.converged
    assert not any("stopped after" in text for text in result.warnings)
    cut = replace(fit, fit=replace(fit.fit, converged=False, evaluations=60))
    assert "stopped after 60 evaluations" in warnings.fit_warnings(cut)[0]
    assert_array_equal(warnings.fit_warnings(fit), [])
