"""What a recording serves for, judged by its drive, and what speaks against a model."""

import math
import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.signal import lfilter

import truths
from microrad.lab.identify import FORMS, IdentificationError, JointFit, Units, identify
from microrad.lab.identify.hysteresis.bouc_wen import BoucWenFit
from microrad.lab.identify.hysteresis.prandtl_ishlinskii import PrandtlIshlinskiiFit
from microrad.lab.identify.records import si_records
from microrad.lab.identify.selection import roles as selection_roles
from microrad.lab.identify.selection import warnings
from microrad.lab.identify.selection.predictions import Prediction, Score
from microrad.lab.identify.selection.roles import is_broadband, roles, single_period, whole_periods
from microrad.lab.identify.selection.warnings import ResidualTest, residual_test, residual_warnings
from microrad.lab.recording import Recording
from microrad.mirror.hysteresis import BoucWen
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
    for samples, left in ((1700, (1700, None)), (1999, (1999, None)), (2000, (2000, 1000)), (3000, (3000, 1000))):
        short = whole_periods(replace(whole, drive=whole.drive[:samples], output=whole.output[:samples]))
        assert (short.samples, short.period_samples) == left
    assert whole_periods(recording(SINE)).period_samples is None


@pytest.mark.parametrize(("samples", "single"), [(1000, True), (1999, True), (2000, False), (4000, False)])
def test_two_whole_periods_are_not_a_single_one(samples, single):
    whole = recording(np.tile(multisine(1.0)[:1000], 4), period=1000)
    cut = replace(whole, drive=whole.drive[:samples], output=whole.output[:samples])
    assert single_period([cut]) is single
    assert not single_period([cut, cut])
    assert not single_period([replace(cut, period_samples=None)])
    assert not single_period([])


def test_exactly_half_of_the_largest_drive_is_small():
    wide = multisine(1.0)
    large, half = recording(np.where(np.arange(8000) % 2, 1.0, -1.0) * np.ptp(wide)), recording(wide)
    assert np.ptp(half.drive) == 0.5 * np.ptp(large.drive)
    assert roles([large, half]).broadband == [half]


@pytest.mark.parametrize(("filled", "wide"), [([1] * 11, True), ([1] * 10, False), ([1] * 10 + [0] + [1] * 10, False)])
def test_more_than_a_decade_without_a_gap_is_broadband(monkeypatch, filled, wide):
    monkeypatch.setattr(selection_roles, "_filled", lambda record: np.array([0, *filled, 0], dtype=bool))
    assert is_broadband(recording(WIDE["noise"])) is wide


def test_a_role_of_broadband_is_refused_for_what_fills_no_more_than_a_sine(monkeypatch):
    one, other = replace(recording(WIDE["noise"]), role="broadband"), recording(SINE)
    monkeypatch.setattr(selection_roles, "_filled", lambda record: np.array([0, 1, 1, 1, 1, 0], dtype=bool))
    with pytest.raises(IdentificationError, match=r"^record: its role is broadband and its drive is a sine"):
        roles([one, other])
    assert roles([other, (as_loop := replace(other, role="loops"))]).loops == [other, as_loop]
    monkeypatch.setattr(selection_roles, "_filled", lambda record: np.array([0, 1, 1, 1, 1, 1], dtype=bool))
    assert roles([one, other]).broadband == [one]


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
    falling = Prediction(np.zeros(2000), noise - 2 * trend, 0, 1000, 0)
    least, found = warnings.drift([moving, falling, quiet], [record] * 3, 1e-3)
    assert least == pytest.approx(-4e-5, rel=0.05)
    assert ["drifts by 2" in found[0], "drifts by -4" in found[1], len(found)] == [True, True, 2]
    assert "(-4 % of the peak-to-peak output) in 1 s: creep beyond" in found[1].replace("-4.0 %", "-4 %")


@pytest.mark.parametrize(
    ("share", "noise", "told"), [(0.0019, 0.0, 0), (0.0021, 0.0, 1), (0.0021, 0.1, 0), (0.1, 0.1, 1)]
)
def test_a_drift_is_told_above_a_fifth_of_a_per_cent_and_three_standard_errors(share, noise, told):
    """The error of the trend of 2000 samples of white noise is sqrt(12 / 2000) of it, 0.8 % here."""
    residual = share * np.linspace(-0.5, 0.5, 2000) + noise * philox(8).standard_normal(2000)
    seen = Prediction(np.zeros(2000), residual, 0, 1000, 0)
    assert len(warnings.drift([seen], [recording(SINE[:2000])], 1.0)[1]) == told


@pytest.mark.parametrize(("start", "told"), [(0, 0), (200, 0), (201, 1)])
def test_what_is_not_judged_is_told_above_a_fifth_of_the_record(start, told):
    record = recording(SINE[:1000])
    seen = Prediction(np.zeros(1000), np.zeros(1000), start, start, 0)
    assert (
        warnings.set_aside_warnings([record], [seen])
        == [
            "record: the first 201 of 1000 samples are not judged, because what the mirror remembers from before is "
            "not known until the drive has swept its range once; begin a record for validation with its largest sweep."
        ]
        * told
    )


def test_the_range_of_drives_and_rates_is_told_to_a_thousandth():
    """A sine over the range of 10 V moves at most at pi 10 V times its frequency."""
    drives, rates = warnings.range_warnings((-0.00001, 10.00004), 500.0)
    assert drives.startswith("Valid for drives from 0 V to 10 V; outside")
    assert rates.startswith("Not valid above 500 V/s, the fastest rate of the recordings: ")
    assert rates.endswith("reaches it at 15.92 Hz.")
    assert warnings.range_warnings((-123.456, 1234.56), 1.0)[0].startswith("Valid for drives from -123 V to 1235 V")
    assert warnings.range_warnings((0.12346, 0.23457), 1.0)[0].startswith("Valid for drives from 0.1235 V to 0.2346 V")


@pytest.mark.parametrize(("noisy", "told"), [(0.2, 0), (0.21, 1)])
def test_a_drive_is_called_noisy_above_a_fifth_of_the_fastest_rate(monkeypatch, noisy, told):
    monkeypatch.setattr(warnings, "noisiness", lambda records: noisy)
    records = si_records([recording(SINE), recording(STAIRCASE)], Units())
    (found,) = warnings.rate_warnings(records, None) or ("",)
    assert found.startswith("The drive is noisy: its rate from sample to sample scatters by 21 %") == bool(told)


@pytest.mark.parametrize(
    ("name", "linear", "depends"),
    [
        ("prandtl_ishlinskii_creep", None, False),
        ("bouc_wen_classical", None, False),
        ("prandtl_ishlinskii_rate", None, True),
        ("bouc_wen_asymmetric", None, True),
        ("prandtl_ishlinskii_joint", "a linear part", True),
    ],
)
def test_a_joint_model_without_rate_and_linear_part_is_one_average_loop(name, linear, depends):
    """Loops of 7 Hz and of 14 Hz."""
    fit = object.__new__(JointFit)
    for key, value in {"form": FORMS[name], "linear": linear}.items():
        object.__setattr__(fit, key, value)
    records = si_records([recording(SINE), recording(np.tile(SINE[::2], 2))], Units())
    found = warnings.rate_warnings(records, fit)
    assert warnings.depends_on_rate(fit) is depends
    assert len(found) == (not depends)
    assert all(
        re.match(r"The loops have peak rates from 2[\d.]+ V/s to 4[\d.]+ V/s, and the model does", t) for t in found
    )
    (one,) = warnings.rate_warnings(records[:1], fit)
    assert one.startswith("One loop rate only (peaks from 2")


def test_scores_that_speak_against_a_model():
    line, good = Score("straight line", 2.0, 5.0, 2.0, 5.0), Score("m", 1.0, 3.0, 1.1, 3.0)
    assert warnings.score_warnings(good, line) == []
    (worse,) = warnings.score_warnings(replace(good, held_out_rms_percent=1.6), line)
    assert "grows from 1.00 % on the fitted samples to 1.60 %" in worse
    assert "No model is better than a straight line" in warnings.score_warnings(Score("m", 1.9, 3.0, 2.1, 3.0), line)[0]
    assert len(warnings.score_warnings(Score("m", 2.0, 3.0, 2.0, 3.0), line)) == 1  # no better than the line
    assert warnings.score_warnings(Score("m", 1.0, 3.0, 1.5, 3.0), line) == []  # half as much again is not too much


def test_held_out_samples_beyond_the_fitted_drives_are_counted():
    record = recording(np.concatenate([np.linspace(0, 10, 100), [10.1, 10.3, -0.5], np.zeros(97)]))
    seen = Prediction(np.zeros(200), np.zeros(200), 0, 100, 0)
    (text,) = warnings.held_out_warnings([record], Units(), (0.0, 10.0), [seen])
    assert text.startswith("2 held-out samples")  # 10.1 is within the margin of 2 %
    assert warnings.held_out_warnings([record], Units(), (-1.0, 11.0), [seen]) == []
    edge = recording([99.0, -99.0, 51.0, -1.0, 51.5, -1.5, 60.0])
    behind = Prediction(np.zeros(7), np.zeros(7), 0, 2, 0)
    (text,) = warnings.held_out_warnings([edge], Units(), (0.0, 50.0), [behind])
    assert text.startswith("3 held-out samples lie outside")  # 1 V is the margin of 50 V, and belongs to the range
    assert warnings.held_out_warnings([edge], Units("mV"), (0.0, 50.0), [behind]) == []


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


# ------------------------------------------------------------------------------------------ numbers unlike each other
def told(function, *given, **words):
    with pytest.raises(IdentificationError) as caught:
        function(*given, **words)
    return str(caught.value)


def test_a_role_that_cannot_be_is_told_in_full_for_the_second_of_two_records():
    good, sine = (
        replace(recording(WIDE["noise"]), role="broadband"),
        replace(recording(SINE, name="b"), role="broadband"),
    )
    assert told(roles, [good, sine]) == (
        "b: its role is broadband and its drive is a sine, of which a linear part cannot be told; give it the role "
        "loops, or leave the role out."
    )
    assert told(roles, [good, replace(good, path="c")]) == (
        "record: every recording has the role broadband, and none is left for the hysteresis; leave the role of one "
        "with a large drive out."
    )


def test_records_for_validation_are_those_given_and_then_those_that_say_so():
    given = [
        replace(recording(SINE, name=name), role=role)
        for name, role in (("a", ""), ("b", "validation"), ("c", "loops"))
    ]
    beside = [recording(SINE, name="d"), replace(recording(SINE, name="e"), role="validation")]
    fitted, unseen = selection_roles.for_validation(given, beside)
    assert [r.path for r in fitted] == ["a", "c"] and [r.path for r in unseen] == ["d", "e", "b"]
    assert told(selection_roles.for_validation, given, [*beside, replace(given[0], path="f", role="broadband")]) == (
        "f: it is given for validation and its role is broadband; give it to be fitted, or leave the role out."
    )
    assert told(selection_roles.for_validation, given[1:2] * 2, ()) == (
        "b: every recording has the role validation; leave one without a role, to be fitted."
    )


def test_of_broadband_records_at_one_rate_those_of_the_longest_period_are_averaged():
    short, long, chirps = (
        recording(np.tile(multisine(0.3, seed=k)[: 8000 // n], n), period=period, name=name)
        for k, (n, period, name) in enumerate(((2, 4000, "short"), (1, 8000, "long"), (1, None, "chirp")))
    )
    found = roles([recording(SINE), short, chirps, long, replace(long, path="twin")])
    assert [r.path for r in found.response] == ["long", "twin"]
    assert [r.path for r in found.broadband] == ["short", "chirp", "long", "twin"]


def test_what_a_broadband_record_is_not_fitted_for_is_told_in_full():
    sine, slow, fast = (
        recording(SINE),
        recording(multisine(0.3), 1000.0, name="slow"),
        recording(chirp(0.3), name="fast"),
    )
    served = roles([sine, slow, fast])
    assert warnings.use_warnings(served, linear=False) == [
        f"{name}: broadband, and fitted by nothing: no model with a linear part was asked for."
        for name in ("slow", "fast")
    ]
    assert warnings.use_warnings(served, linear=True) == [
        "slow: broadband, and fitted by nothing: only recordings at the highest sample rate and of one period are "
        "averaged, periodic ones before chirps."
    ]
    narrow = replace(recording(LOOPS["half a decade of multisine"], name="narrow"), role="broadband")
    assert warnings.use_warnings(roles([sine, narrow]), linear=True) == [
        "narrow: broadband as its role says, though its drive does not fill a decade of frequencies: poles and zeros "
        "outside what it fills are not known."
    ]
    wide = recording(multisine(0.3), name="wide")
    for both in ((narrow, wide), (wide, narrow)):  # each is judged by itself
        served = roles([sine, *both])
        assert len(served.response) == 2
        assert [each.partition(":")[0] for each in warnings.use_warnings(served, linear=True)] == ["narrow"]
    one = recording(multisine(0.3), period=8000, name="one")
    assert warnings.use_warnings(roles([sine, one]), linear=True) == [
        "one: one period only, so it is fitted as a drive that does not repeat; record two periods, or the same lines "
        "with other phases, to tell noise from distortion."
    ]
    assert warnings.use_warnings(roles([one, recording(multisine(5.0), name="large")]), linear=False) == []


def test_the_valid_range_is_told_in_full():
    assert warnings.range_warnings((-2.34567, 7.12345), 345.6789) == [
        "Valid for drives from -2.346 V to 7.123 V; outside that range the model is an extrapolation.",
        "Not valid above 345.7 V/s, the fastest rate of the recordings: a sine over the whole drive range reaches it "
        "at 11.62 Hz.",
    ]
    assert warnings.range_warnings((0.0, 2.0), 75_398.2)[1] == (
        "Not valid above 75400 V/s, the fastest rate of the recordings: a sine over the whole drive range reaches it "
        "at 12000 Hz."
    )


def test_a_drift_is_told_in_full_for_the_record_that_has_it():
    """3 urad over 150 of 200 samples of 2 kHz; before them the residual is no trend."""
    residual = np.concatenate([np.full(50, 9.0), np.linspace(5e-6, 2e-6, 150) + 1e-9 * (-1.0) ** np.arange(150)])
    moving, still = Prediction(np.zeros(200), residual, 50, 100, 0), Prediction(np.zeros(200), np.zeros(200), 0, 100, 0)
    given = [recording(SINE[:200], name=name) for name in ("a", "b")]
    largest, found = warnings.drift([still, moving], given, 4e-4)
    assert largest == pytest.approx(-3e-6, rel=1e-4)
    assert found == [
        "b: the residual drifts by -3 ± 0.00028 urad (-0.75 % of the peak-to-peak output) in 0.075 s: creep beyond "
        "what the model holds, or a warming sensor."
    ]


def test_two_records_of_millivolts_may_both_go_beyond_the_fitted_drives():
    given = [recording([9000.0, 0.0, 6000.0, -2000.0, 3000.0]), recording([8000.0, 5110.0, 5090.0, -1090.0, -1150.0])]
    seen = [Prediction(np.zeros(5), np.zeros(5), 0, split, 0) for split in (1, 0)]
    assert warnings.held_out_warnings(given, Units("mV"), (-1.0, 4.0), seen) == [
        "6 held-out samples lie outside the fitted drive range; the held-out residual judges them too."
    ]


def test_scores_that_speak_against_a_model_are_told_in_full():
    assert warnings.score_warnings(Score("m", 1.234, 9.0, 5.678, 9.0), Score("line", 8.0, 9.0, 5.5, 9.0)) == [
        "No model is better than a straight line on the held-out samples: do not use the hysteresis.",
        "The residual grows from 1.23 % on the fitted samples to 5.68 % on the held-out ones: drift, another regime, "
        "or too short a record.",
    ]


def test_residuals_that_are_not_noise_are_told_in_full():
    auto, cross = (np.where(np.arange(n) < k, 0.5, -0.01) for n, k in ((40, 10), (41, 20)))
    assert residual_warnings(ResidualTest(400, 0.098, auto, -cross)) == [
        "The residual on the held-out samples is not white: 25 % of its correlations over 40 samples lie outside ± "
        "0.098 (5 % would be noise). Standard errors count that; what is left is dynamics, hysteresis or disturbance "
        "outside the model.",
        "The residual follows the drive: 49 % of the cross-correlations lie outside ± 0.098 (5 % would be noise), so a "
        "better model of these recordings exists.",
    ]


@pytest.mark.parametrize(("samples", "order", "lags"), [(39, 1, 38), (100, 5, 50), (400, 20, 50), (1000, 20, 50)])
def test_a_short_residual_has_fewer_lags_and_a_shorter_whitener(samples, order, lags):
    test = residual_test(philox(1).standard_normal(samples), philox(2).standard_normal(samples))
    assert len(test.autocorrelation) == min(lags, samples - 1)
    assert len(test.cross_correlation) == min(50, samples - order - 1) + 1


def test_rates_of_loops_are_told_in_full(monkeypatch):
    fit = object.__new__(PrandtlIshlinskiiFit)
    monkeypatch.setattr(warnings, "noisiness", lambda records: 0.2345)
    monkeypatch.setattr(warnings, "loop_rates", lambda records: (12.3456, 2345.678))
    monkeypatch.setattr(warnings, "one_rate_only", lambda records: False)
    noisy = (
        "The drive is noisy: its rate from sample to sample scatters by 23 % of the fastest rate; use the commanded "
        "drive, or filter it, before trusting rate-dependent parameters."
    )
    assert warnings.rate_warnings((), fit) == [
        "The loops have peak rates from 12.35 V/s to 2346 V/s, and the model does not depend on rate: one average loop "
        "stands for all.",
        noisy,
    ]
    monkeypatch.setattr(warnings, "one_rate_only", lambda records: True)
    assert warnings.rate_warnings((), fit) == [
        "One loop rate only (peaks from 12.35 V/s to 2346 V/s): how the hysteresis changes with frequency is not known "
        "from these recordings, and delta and d2 only describe the shape of this loop; record the same loop at two "
        "more frequencies.",
        noisy,
    ]


def with_values(kind, **values):
    fit = object.__new__(kind)
    for key, value in values.items():
        object.__setattr__(fit, key, value)
    return fit


def test_a_mirror_that_first_moves_the_wrong_way_is_told_in_full_with_the_slope_of_its_form():
    """Turned over where it falls: d1 = -40 mrad/V, and behind a reversal 2 epsilon = 100 mrad/V against it."""
    model = BoucWen(-0.04, 0.0, 0.05, 0.0, 2.0, 0.0)
    static = with_values(
        BoucWenFit,
        model=model,
        admissible=False,
        slope_after_reversal_rad_per_v=-0.0123456,
        lowest_slope_rad_per_v=-0.06,
    )
    wrong = "Not admissible: just after a {}reversal the modelled mirror first moves the wrong way (-60 mrad/V against "
    assert warnings.fit_warnings(static) == [
        wrong.format("") + "d1 = 40 mrad/V); the model bouc_wen_admissible excludes it.",
        warnings._FLIPPED,
    ]
    search = SimpleNamespace(converged=False, evaluations=77)
    joint = with_values(JointFit, model=model, fit=search)
    assert warnings.fit_warnings(joint) == [
        "The search for the parameters stopped after 77 evaluations, before it had settled: the model is what the "
        "scores say, but its standard errors are those of a point that is no minimum.",
        wrong.format("slow ") + "d1 = 40 mrad/V); a Prandtl-Ishlinskii model never does.",
        warnings._FLIPPED,
    ]
    plays = with_values(PrandtlIshlinskiiFit, sign=-1)
    assert warnings.fit_warnings(plays) == [warnings._FLIPPED]
    assert warnings.fit_warnings(with_values(PrandtlIshlinskiiFit, sign=1)) == []


@pytest.mark.parametrize(
    ("lines", "bands"),
    [
        ({100: 1.0}, [19, 20]),
        ({100: 1.0, 300: 0.0295}, [19, 20, 24]),
        ({100: 1.0, 300: 0.028}, [19, 20]),
        ({10: 1.0, 13: 0.5}, [9, 10, 11]),
        ({2: 1.0}, [0, 3, 4]),
        ({795: 3.0, 1000: 3.0}, [28, 29, 30]),
    ],
)
def test_tenths_of_a_decade_are_filled_by_lines_of_a_thousandth_of_the_largest(lines, bands):
    """A window spreads a line to its neighbours on both sides."""
    turn = 2 * np.pi * np.arange(8000) / 8000
    drive = 5.0 + sum(size * np.sin(k * turn) for k, size in lines.items())
    assert np.flatnonzero(selection_roles._filled(recording(drive))).tolist() == bands


@pytest.mark.parametrize(
    ("levels", "samples", "wide"), [(20, 46, True), (20, 49, False), (21, 48, True), (19, 52, False)]
)
def test_a_drive_that_rests_on_twenty_levels_half_of_the_time_is_not_broadband(levels, samples, wide):
    """A thousand samples of noise, about one in each of the levels that are told apart."""
    rests = np.repeat(np.arange(levels) * 0.04 - 0.41, samples)
    drive = np.concatenate([np.linspace(-1.0, 1.0, 1000), rests])
    assert is_broadband(recording(philox(1).permutation(drive))) is wide


@pytest.mark.parametrize(
    ("low", "high", "rate", "words"),
    [
        (-0.00004, 10.0, 314.159, ("0 V to 10 V", "314.2 V/s", "10 Hz")),
        (-1.23456, 9.87654, 12345.678, ("-1.23 V to 9.88 V", "12350 V/s", "353.7 Hz")),
        (100.0004, 100.9996, 2.0, ("100 V to 101 V", "2 V/s", "0.6371 Hz")),
        (100.4, 223.4, 20.0, ("100.4 V to 223.4 V", "20 V/s", "0.05176 Hz")),
        (0.0, 12_345.6, 1e6, ("0 V to 12346 V", "1000000 V/s", "25.78 Hz")),
    ],
)
def test_a_range_is_told_to_a_thousandth_of_its_width_and_a_rate_in_four_digits(low, high, rate, words):
    valid, fast = warnings.range_warnings((low, high), rate)
    assert valid == f"Valid for drives from {words[0]}; outside that range the model is an extrapolation."
    assert fast == (
        f"Not valid above {words[1]}, the fastest rate of the recordings: a sine over the whole drive range reaches it "
        f"at {words[2]}."
    )


@pytest.mark.parametrize(
    ("lost", "told"),
    [
        ((0.0, 0.0), None),
        ((-0.019, 10.019), None),
        ((-0.3, 5.0), 1),
        ((-0.21, 10.21), 2),
        ((10.19, -0.19), None),
    ],
)
def test_a_held_out_sample_beyond_a_fiftieth_of_the_fitted_range_is_counted(lost, told):
    drive = np.concatenate([[-7.0, 20.0], np.linspace(0, 10, 48), lost])
    seen = Prediction(drive, drive, 1, 2, 0)
    found = warnings.held_out_warnings([recording(1e3 * drive)], Units("mV", "urad"), (0.0, 10.0), [seen])
    lie, them = ("sample lies", "it") if told == 1 else ("samples lie", "them")
    samples = f"{told} held-out {lie} outside the fitted drive range; the held-out residual judges {them} too."
    assert found == ([] if told is None else [samples])


@pytest.mark.parametrize(
    ("values", "kept"),
    [
        ((1999, 800), (1600, 800)),
        ((1600, 800), (1600, 800)),
        ((1599, 800), (1599, None)),
        ((4000, 800), (4000, 800)),
        ((2500, 800), (2400, 800)),
        ((2500, None), (2500, None)),
    ],
)
def test_of_a_periodic_record_whole_periods_are_kept_where_there_are_two(values, kept):
    samples, period = values
    cut = whole_periods(recording(np.arange(float(samples)), period=period))
    assert (cut.samples, cut.output.shape[0], cut.period_samples) == (kept[0], kept[0], kept[1])


def test_where_all_are_broadband_those_that_do_not_say_so_are_the_loops_as_well():
    small, large, other = (
        recording(chirp(0.3), name="small"),
        recording(multisine(5.0), name="large"),
        recording(multisine(2.0, seed=2), 1000.0, name="other"),
    )
    found = roles([replace(small, role="broadband"), large, other])
    assert [[r.path for r in of] for of in found] == [
        ["small", "large"],
        ["small", "large", "other"],
        ["large", "other"],
    ]
    found = roles([large, replace(other, role="broadband")])
    assert [[r.path for r in of] for of in found] == [["large"], ["large", "other"], ["large"]]
