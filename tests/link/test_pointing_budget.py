"""The rules that sum pointing errors: the standard's worked example, draws, closed forms, and the refusals."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import ncx2

from microrad.link import pointing
from microrad.link.pointing import Jitter, error_classes, radial_cdf, summation
from microrad.link.pointing.error_classes import ErrorTerm, StatedError, error_term

URAD = 1e-6
ARCSEC = math.radians(1.0) / 3600.0
THREE_SIGMA = 0.9973002039367398
KINDS, STATISTICS = ("bias", "random", "drift", "transient"), ("1-sigma", "2-sigma", "3-sigma", "bound")
COUNT = 200_000


def term(mean=(0.0, 0.0), sigma=(0.0, 0.0), kind="random", stated=1.0, **more):
    return ErrorTerm("term", kind, stated, mean, sigma, **more)


def stated(kind, statistic="3-sigma", axes="per-axis", error=60.0 * URAD, name="line"):
    return StatedError(name, error, kind, statistic, axes)


def by_rule(terms, confidence):
    return {each.rule: each for each in summation.summations(terms, confidence)}


# ---- numbers from outside
# ECSS-E-ST-60-10C, Annex C: standard deviations about x, y, z (arcsec), and the totals as printed
ANNEX_C = {
    "star tracker noise": (10.0, 5.0, 5.0),
    "attitude-dependent bias": (6.67, 3.33, 3.33),
    "controller": (3.16, 3.16, 3.16),
    "thermoelastic": (1.63, 1.63, 1.63),
    "misalignment": (2.89, 2.89, 2.89),
    "targeting": (3.54, 0.71, 3.54),
    "flexible modes": (2.12, 3.54, 2.12),
}
RELATIVE = ("star tracker noise", "controller", "flexible modes")


@pytest.mark.promise("readme-7")
@pytest.mark.parametrize(
    ("names", "printed", "printed_twice"),
    [
        (tuple(ANNEX_C), (13.51, 8.37, 8.61), (27.01, 16.75, 17.21)),
        (RELATIVE, (10.70, 6.89, 6.28), (21.40, 13.78, 12.57)),
    ],
)
def test_the_standards_worked_example_comes_out(names, printed, printed_twice):
    last_digit = 0.0101
    for axes in ((0, 1), (1, 2)):
        terms = [term(sigma=tuple(ANNEX_C[name][axis] * ARCSEC for axis in axes)) for name in names]
        total = summation.mean_and_sigma(terms)
        # the example multiplies by 2 for "95 %"
        limits = summation.axis_totals_rad(terms, 0.954499736103642)
        for index, axis in enumerate(axes):
            assert total.rms_rad[index] / ARCSEC == pytest.approx(printed[axis], abs=last_digit)
            assert limits[index] / ARCSEC == pytest.approx(printed_twice[axis], abs=last_digit)


@pytest.mark.parametrize(("count", "percent"), [(1, 68.27), (2, 95.45), (3, 99.73)])
def test_the_multiple_of_sigma_is_that_of_a_gaussian(count, percent):
    assert summation.sigma_multiple(percent / 100) == pytest.approx(count, abs=2e-3)


# ECSS-E-ST-60-10C, A.2.4, in standard deviations of one axis
@pytest.mark.parametrize(("confidence", "printed"), [(0.95, 2.45), (THREE_SIGMA, 3.44)])
def test_two_like_axes_have_the_rayleigh_totals_that_the_standard_prints(confidence, printed):
    terms = [term(sigma=(1.0, 1.0))]
    assert summation.rayleigh_total_rad(terms, confidence) == pytest.approx(printed, abs=5e-3)
    assert summation.exact_total_rad(terms, confidence) == pytest.approx(printed, abs=5e-3)


@pytest.mark.parametrize(("confidence", "printed"), [(0.954499736103642, 2.83), (THREE_SIGMA, 4.24)])
def test_two_like_axes_have_the_general_totals_that_the_standard_prints(confidence, printed):
    assert summation.radial_total_rad([term(sigma=(1.0, 1.0))], confidence) == pytest.approx(printed, abs=5e-3)


def test_the_rayleigh_total_is_the_radius_of_a_spiral_scan():
    terms = [term(sigma=(300 * URAD, 300 * URAD))]
    assert summation.rayleigh_total_rad(terms, 0.995) == pytest.approx(976.6 * URAD, abs=0.05 * URAD)


@pytest.mark.promise("link-29")
def test_a_radial_rms_is_shared_by_two_axes():
    # OLYMPUS base motion, 160 / (1 + f^2) urad^2/Hz radial: sqrt(80 pi) urad rms, 11.21 about each axis
    olympus = error_term(stated("random", "1-sigma", "radial", math.sqrt(80 * math.pi) * URAD))
    assert olympus.sigma_rad == pytest.approx((11.21 * URAD, 11.21 * URAD), rel=1e-3)


def test_point_ahead_from_a_500_km_orbit_is_71_microradians():
    assert pointing.point_ahead_rad(10_650.0) == pytest.approx(71e-6, rel=2e-3)
    assert pointing.point_ahead_rad(0.0) == 0.0


# ---- classes against draws
def sigmas_of(statistic):
    return {"1-sigma": 1, "2-sigma": 2, "3-sigma": 3}.get(statistic)


def spread(draw, statistic, axes, error):
    """A value for each satellite (or time), about x: Gaussian, or evenly within the bound."""
    if statistic != "bound":
        sigma = error / sigmas_of(statistic)
        return sigma * draw.standard_normal(COUNT) / (math.sqrt(2) if axes == "radial" else 1.0)
    if axes == "radial":
        return error * np.sqrt(draw.random(COUNT)) * np.cos(2 * math.pi * draw.random(COUNT))
    return error * (2 * draw.random(COUNT) - 1)


def drawn(draw, line, interpretation):
    """The error about x at random times, of the satellites that the interpretation takes."""
    if line.kind == "random" or interpretation == "mixed":
        values = spread(draw, line.statistic, line.axes, line.error_rad)
    else:
        out = {"1-sigma": 3.0, "2-sigma": 1.5}.get(line.statistic, 1.0) * line.error_rad
        values = np.full(COUNT, out * (math.cos(math.pi / 4) if line.axes == "radial" else 1.0))
    return values * draw.random(COUNT) if line.kind == "drift" else values


def assert_mean_and_sigma(values, mean, sigma):
    if np.ptp(values) == 0.0:
        assert (mean, sigma) == (pytest.approx(values[0]), 0.0)
        return
    assert abs(values.mean() - mean) < 2.576 * values.std() / math.sqrt(COUNT)
    squares = (values - values.mean()) ** 2
    assert abs(values.var() - sigma**2) < 2.576 * squares.std() / math.sqrt(COUNT)


@pytest.mark.promise("link-29", "link-30", "link-31")
@pytest.mark.parametrize("interpretation", ["temporal", "mixed"])
@pytest.mark.parametrize("axes", ["per-axis", "radial"])
@pytest.mark.parametrize("statistic", ["2-sigma", "3-sigma", "bound"])
@pytest.mark.parametrize("kind", KINDS)
def test_mean_and_deviation_of_a_class_are_those_of_draws(kind, statistic, axes, interpretation):
    line = stated(kind, statistic, axes)
    values = drawn(np.random.Generator(np.random.Philox(key=3)), line, interpretation)
    found = error_term(line, interpretation)
    assert_mean_and_sigma(values, found.mean_rad[0], found.sigma_rad[0])
    assert (found.mean_rad[1], found.sigma_rad[1]) == (found.mean_rad[0], found.sigma_rad[0])


@pytest.mark.promise("link-35")
@pytest.mark.parametrize("interpretation", ["temporal", "mixed"])
def test_a_mixture_has_the_mean_and_deviation_of_draws(interpretation):
    lines = (
        stated("random", "3-sigma", error=90 * URAD),
        stated("random", "bound", "radial", error=40 * URAD),
        stated("drift", "2-sigma", error=50 * URAD),
        stated("drift", "bound", "radial", error=70 * URAD),
        stated("bias", "1-sigma", error=20 * URAD),
        stated("transient", "bound", error=30 * URAD),
    )
    draw = np.random.Generator(np.random.Philox(key=8))
    values = sum(drawn(draw, line, interpretation) for line in lines)
    total = summation.mean_and_sigma([error_term(line, interpretation) for line in lines])
    assert_mean_and_sigma(values, total.bias_rad[0], total.rms_rad[0])


def test_an_error_about_one_axis_leaves_the_other_alone():
    for interpretation in ("temporal", "mixed"):
        one, each = (error_term(stated("drift", "bound", axes), interpretation) for axes in ("x", "per-axis"))
        assert (one.mean_rad[0], one.sigma_rad[0]) == (each.mean_rad[0], each.sigma_rad[0])
        assert (one.mean_rad[1], one.sigma_rad[1]) == (0.0, 0.0)


@pytest.mark.promise("link-30")
@pytest.mark.parametrize("last", [0.1, 0.5, 1.0, 4.0])
def test_a_transient_that_comes_and_goes_is_covered_more_often_than_budgeted(last):
    line, radius = error_term(stated("transient", "bound", error=40 * URAD)), 90 * URAD
    others = Jitter((15 * URAD, 5 * URAD), (20 * URAD, 30 * URAD))

    def covered(part):
        mean = tuple(bias + part * own for bias, own in zip(others.bias_rad, line.mean_rad, strict=True))
        return float(radial_cdf(Jitter(mean, others.rms_rad), radius))

    budgeted = covered(1.0)
    assert line.sigma_rad == (0.0, 0.0)
    decaying = np.mean([covered(math.exp(-time)) for time in np.linspace(0.0, last, 50)])
    switched = min(last, 1.0) * covered(1.0) + (1.0 - min(last, 1.0)) * covered(0.0)
    assert decaying > budgeted
    assert switched >= budgeted


@pytest.mark.promise("link-30", "link-31")
def test_a_mission_without_pointing_errors_has_no_budget_of_them():
    with pytest.raises(ValueError, match=r"the mission states no pointing errors; give it the table \[pointing\]"):
        pointing.open_loop_budget(None, None, None, {})


def test_the_words_of_a_line_say_what_was_calculated():
    temporal = error_classes.basis(stated("bias", "2-sigma", "radial"))
    assert temporal == (
        "bias, 2-sigma, radial: mean 1.5 error / sqrt(2) about each axis, constant; worst-case satellite (temporal)"
    )
    assert "error / sqrt(3), evenly up to the bound" in error_classes.basis(stated("random", "bound"))
    assert "error / 2, evenly over a disc" in error_classes.basis(stated("random", "bound", "radial"))
    assert "error / (2 sqrt(2))" in error_classes.basis(stated("random", "2-sigma", "radial"))
    mixed = error_classes.basis(stated("drift", "2-sigma"), "mixed")
    assert mixed.endswith("error / 2 / sqrt(3), ramp from zero; random satellite at a random time (mixed)")
    bound = error_classes.basis(stated("drift", "bound"), "mixed")
    assert "standard deviation error / sqrt(3) / sqrt(3), evenly up to the bound, ramp from zero; random" in bound
    assert "counted as always present" in error_classes.basis(stated("transient", axes="x"))


# ---- rules
@pytest.mark.promise("link-32", "link-35")
def test_means_add_and_deviations_add_in_squares():
    terms = [
        term(sigma=(4.0, 2.0)),
        term(sigma=(3.0, 0.0)),
        term(mean=(2.0, -5.0)),
        term(mean=(-7.0, 1.0)),
    ]
    total = summation.mean_and_sigma(terms)
    assert total.bias_rad == (-5.0, -4.0)
    assert total.rms_rad == (5.0, 2.0)
    assert summation.axis_totals_rad(terms, THREE_SIGMA) == pytest.approx((20.0, 10.0))
    assert summation.radial_total_rad(terms, THREE_SIGMA) == pytest.approx(math.hypot(5, 4) + 3 * math.hypot(5, 2))
    assert summation.rayleigh_total_rad(terms, 0.9) == pytest.approx(5.0 * math.sqrt(2 * math.log(10)))


@pytest.mark.promise("readme-7")
@pytest.mark.promise("link-32")
def test_the_exact_total_is_that_of_the_noncentral_chi_square():
    terms = [term(mean=(3.0, 0.0)), term(sigma=(2.0, 2.0)), term(mean=(0.0, -4.0))]
    for confidence in (0.5, 0.95, 0.997, 1 - 1e-9):
        expected = 2.0 * math.sqrt(ncx2.isf(1 - confidence, 2, 25.0 / 4.0))
        assert summation.exact_total_rad(terms, confidence) == pytest.approx(expected, rel=1e-8)


@pytest.mark.promise("readme-7")
@pytest.mark.promise("link-32")
def test_old_practice_adds_classes_linearly():
    terms = [term(stated=3.0), term(stated=4.0), term(stated=5.0, kind="bias"), term(stated=12.0, kind="bias")]
    assert summation.esa_1993_rad(terms) == pytest.approx(5.0 + 13.0)
    assert summation.rss_rad(terms) == pytest.approx(math.sqrt(9 + 16 + 25 + 144))
    assert by_rule(terms, 0.9)["esa-1993"].authority.endswith("ESA-NCR-502 (1993)")


@pytest.mark.promise("link-32")
def test_the_root_sum_square_is_the_standards_total_exactly_where_it_is_authorised():
    like = [error_term(stated("random", error=error * URAD)) for error in (30.0, 40.0)]
    rules = by_rule(like, THREE_SIGMA)
    assert rules["rss"].caveat == ""
    assert rules["rss"].total_rad == pytest.approx(rules["ecss-axis"].total_rad, rel=1e-9)
    biased = [*like, error_term(stated("bias", name="Alignment"))]
    assert summation.rss_caveat(biased) == "not authorised: Alignment has a mean, and means add linearly"
    mixed = [*like, error_term(stated("random", "1-sigma"))]
    assert "not the same number of standard deviations" in summation.rss_caveat(mixed)


@pytest.mark.promise("link-32")
def test_the_rayleigh_rule_applies_to_small_means_and_like_axes():
    for mean, sigmas, words in (
        (0.0999, (1.0, 0.901), ""),
        (0.101, (1.0, 1.0), "the mean is not 10 times below"),
        (0.1, (0.96, 1.04), "the mean is not 10 times below"),
        (0.0, (1.0, 0.899), "differ by more than 10 %"),
    ):
        terms = [term(mean=(-mean * sigmas[1], 0.0), sigma=sigmas)]
        caveat = summation.rayleigh_caveat(terms)
        assert words in caveat and bool(words) == bool(caveat)
        if not words:
            exact = summation.exact_total_rad(terms, 0.997)
            assert exact * 0.995 < summation.rayleigh_total_rad(terms, 0.997) < exact * 1.05


def test_the_general_rule_for_two_axes_is_too_low_at_low_confidence_and_says_so():
    terms = [term(sigma=(1.0, 1.0))]
    low, high = by_rule(terms, 0.78)["ecss-radial"], by_rule(terms, 0.79)["ecss-radial"]
    assert low.total_rad < summation.exact_total_rad(terms, 0.78)
    assert "below the exact radial error" in low.caveat
    assert high.total_rad > summation.exact_total_rad(terms, 0.79)
    assert high.caveat == ""


@pytest.mark.promise("link-35")
def test_a_sum_that_is_mostly_of_another_shape_is_called_approximate():
    other, random = error_term(stated("random", "bound", name="Backlash")), error_term(stated("random"))
    wide = error_term(stated("random", error=200 * URAD))
    for rule in ("exact", "ecss-axis", "ecss-radial"):
        assert "Backlash is not Gaussian" in by_rule([other, random], 0.997)[rule].caveat
        assert by_rule([other, wide], 0.997)[rule].caveat == ""
    assert not error_term(stated("drift")).gaussian
    assert error_term(stated("bias", "bound")).gaussian
    assert not error_term(stated("bias", "bound"), "mixed").gaussian


def test_a_negligible_deviation_is_left_out_and_a_small_one_is_not():
    bias, uniform = term(mean=(1e-4, 0.0)), {"kind": "random", "stated": 1e-13, "gaussian": False}
    small, negligible = ([bias, term(sigma=(sigma,) * 2, **uniform)] for sigma in (1.01e-13, 0.99e-13))
    assert summation.mean_and_sigma(small).rms_rad == (1.01e-13, 1.01e-13)
    assert "not Gaussian" in summation.shape_caveat(small)
    assert summation.mean_and_sigma(negligible).rms_rad == (0.0, 0.0)
    assert summation.shape_caveat(negligible) == ""
    assert summation.exact_total_rad(negligible, 0.997) == 1e-4
    assert summation.exact_total_rad(small, 0.997) == pytest.approx(1e-4, rel=1e-8)
    assert summation.mean_and_sigma([term(sigma=(1e-31, 2e-309))]).rms_rad == (0.0, 0.0)


@settings(deadline=None, max_examples=40)
@given(
    st.lists(st.tuples(*[st.floats(0.0, 1.0)] * 4), min_size=1, max_size=4),
    st.floats(0.8, 0.99999),
)
def test_at_usual_confidences_the_general_rule_is_never_below_the_exact_total(rows, confidence):
    terms = [term(mean=row[:2], sigma=row[2:]) for row in rows]
    exact, general = (rule(terms, confidence) for rule in (summation.exact_total_rad, summation.radial_total_rad))
    assert exact <= general * (1 + 1e-9)
    worse_axis = max(summation.axis_totals_rad(terms, confidence))
    assert worse_axis <= general * (1 + 1e-9)


# ---- allocation
LINES = (
    stated("random", error=30 * URAD, name="Body"),
    stated("bias", "bound", error=20 * URAD, name="Alignment"),
    stated("drift", "bound", error=12 * URAD, name="Orbit"),
)


def test_what_the_root_sum_square_leaves_is_a_difference_of_squares():
    left = {each.name: each for each in summation.allocate(LINES, 60 * URAD, rule="rss", confidence=0.997)}
    assert left["Body"].largest_rad == pytest.approx(math.sqrt(60**2 - 20**2 - 12**2) * URAD, rel=1e-8)
    assert left["Orbit"].largest_rad == pytest.approx(math.sqrt(60**2 - 20**2 - 30**2) * URAD, rel=1e-8)
    assert left["Orbit"].stated_rad == 12 * URAD


def test_what_the_standard_leaves_about_an_axis_is_in_closed_form():
    left = summation.allocate(LINES, 60 * URAD, rule="ecss-axis", confidence=THREE_SIGMA)
    body, alignment, orbit = (each.largest_rad / URAD for each in left)
    ramp = 12 / math.sqrt(12)
    assert body == pytest.approx(3 * math.sqrt(((60 - 20 - 6) / 3) ** 2 - ramp**2), rel=1e-8)
    assert alignment == pytest.approx(60 - 6 - 3 * math.hypot(10, ramp), rel=1e-8)
    # (40 - D / 2)^2 = 9 (100 + D^2 / 12)
    a, b, c = 0.25 - 0.75, -40.0, 1600.0 - 900.0
    assert orbit == pytest.approx((-b - math.sqrt(b * b - 4 * a * c)) / (2 * a), rel=1e-7)


def test_where_nothing_is_left_it_says_how_much_is_missing():
    ramp = 12 / math.sqrt(12)
    body, alignment, orbit = summation.allocate(LINES, 45 * URAD, rule="ecss-axis", confidence=THREE_SIGMA)
    assert body.largest_rad > 0.0 and body.missing_rad == 0.0 and body.note == ""
    assert alignment.largest_rad > 0.0
    assert orbit.largest_rad == 0.0
    assert orbit.missing_rad == pytest.approx(5 * URAD)
    assert orbit.note == "nothing is left: the other lines alone exceed the total by 5 µrad"
    lost = summation.allocate(LINES, 26 * URAD, rule="ecss-axis", confidence=THREE_SIGMA)
    missing = (26 - 26 + 3 * ramp, 6 + 3 * math.hypot(10, ramp) - 26, 50 - 26)
    assert [each.missing_rad / URAD for each in lost] == pytest.approx(missing)
    assert [each.largest_rad for each in lost] == [0.0, 0.0, 0.0]
    assert [(each.name, each.stated_rad) for each in lost] == [(line.name, line.error_rad) for line in LINES]
    # the others alone just meet it
    (just, _) = summation.allocate(LINES[:2], 20 * URAD, rule="ecss-axis", confidence=THREE_SIGMA)
    assert (just.missing_rad, just.note) == (0.0, "")
    assert just.largest_rad == pytest.approx(0.0, abs=1e-9 * URAD)


@pytest.mark.parametrize("rule", list(summation.TOTALS))
@pytest.mark.parametrize("interpretation", ["temporal", "mixed"])
def test_a_line_alone_gets_the_whole_total(rule, interpretation):
    for kind in KINDS:
        line = stated(kind, "2-sigma", "radial", error=0.0)
        settings_ = {"rule": rule, "confidence": 0.95, "interpretation": interpretation}
        (left,) = summation.allocate([line], 50 * URAD, **settings_)
        reached = summation.TOTALS[rule]([error_term(line.with_error(left.largest_rad), interpretation)], 0.95)
        assert reached == pytest.approx(50 * URAD, rel=1e-7)


# ---- refusals
@pytest.mark.parametrize("confidence", [0.0, 1.0, -0.1, 1.2, math.nan])
def test_no_confidence_is_refused(confidence):
    terms = [term(sigma=(1.0, 1.0))]
    rules = (
        summation.axis_totals_rad,
        summation.radial_total_rad,
        summation.rayleigh_total_rad,
        summation.exact_total_rad,
    )
    for rule in (*rules, summation.summations):
        with pytest.raises(ValueError, match=r"the confidence is .*: it must be finite, above 0 and below 1"):
            rule(terms, confidence)


def test_a_budget_without_terms_is_refused():
    with pytest.raises(ValueError, match="has 0 terms; give at least 1"):
        summation.summations([], 0.997)


@pytest.mark.parametrize("error", [-1e-6, math.nan, math.inf])
def test_no_half_width_is_refused(error):
    with pytest.raises(ValueError, match=r"line: the error is .*: .* at least 0 rad; it is a half width"):
        stated("bias", error=error)


def test_words_without_a_meaning_are_refused():
    with pytest.raises(ValueError, match='no kind "jump"; give one of bias, random, drift, transient'):
        stated("jump")
    with pytest.raises(ValueError, match='no statistic "4-sigma"; give one of 1-sigma'):
        stated("bias", "4-sigma")
    with pytest.raises(ValueError, match='no axes "z"; give one of per-axis, radial, x'):
        stated("bias", "bound", "z")
    with pytest.raises(ValueError, match='no interpretation "ensemble"; give one of temporal, mixed'):
        error_term(stated("bias"), "ensemble")


def test_no_mean_and_no_deviation_are_refused():
    with pytest.raises(ValueError, match=r"term: the mean is nan rad: it must be finite"):
        term(mean=(math.nan, 0.0))
    with pytest.raises(ValueError, match=r"the standard deviation is .* rad; give two values, for axis x and axis y"):
        term(sigma=(1.0,))
    with pytest.raises(ValueError, match="the standard deviation is -1 µrad: it must be finite, at least 0 rad"):
        term(sigma=(0.0, -1e-6))


@pytest.mark.parametrize("velocity", [-1.0, 0.0101 * 299_792_458.0, math.nan])
def test_no_velocity_is_refused(velocity):
    with pytest.raises(ValueError, match="is out of range; give 0 m/s to 2998 km/s"):
        pointing.point_ahead_rad(velocity)


def test_totals_that_leave_nothing_to_allocate_are_refused():
    for total in (0.0, -1e-6, math.nan, math.inf):
        with pytest.raises(ValueError, match=r"the total is .*: it must be finite, above 0 rad"):
            summation.allocate(LINES, total, rule="rss", confidence=0.997)
    with pytest.raises(ValueError, match='no rule "rayleigh" to allocate by; give one of rss, esa-1993'):
        summation.allocate(LINES, 1e-4, rule="rayleigh", confidence=0.997)


MIXED = [
    stated("bias", "bound", "per-axis", 41.0 * URAD, "mount"),
    stated("random", "2-sigma", "radial", 73.0 * URAD, "body"),
    stated("drift", "3-sigma", "x", 55.0 * URAD, "heat"),
    stated("transient", "1-sigma", "per-axis", 17.0 * URAD, "slew"),
]
TERMS = {each: [error_term(one, each) for one in MIXED] for each in ("temporal", "mixed")}


@pytest.mark.parametrize(("found", "expected"), [
    (lambda: [x * 1e6 for each in TERMS["temporal"] for x in (*each.mean_rad, *each.sigma_rad)],
     [
        41.0, 41.0, 0.0, 0.0, 0.0, 0.0, 25.8093975, 25.8093975, 27.5, 0.0, 15.8771324, 0.0, 51.0, 51.0, 0.0,
        0.0,
    ]),
    (lambda: [x * 1e6 for each in TERMS["mixed"] for x in (*each.mean_rad, *each.sigma_rad)],
     [
        0.0, 0.0, 23.671361, 23.671361, 0.0, 0.0, 25.8093975, 25.8093975, 0.0, 0.0, 10.5847549, 0.0, 0.0, 0.0,
        17.0, 17.0,
    ]),
    (lambda: [each.total_rad * 1e6 for each in summation.summations(TERMS["temporal"], 0.95)],
     [101.607086, 186.0, 178.890736, 228.825758, 74.1715085, 200.273085]),
    (lambda: [each.total_rad * 1e6 for each in summation.summations(TERMS["mixed"], 0.9)],
     [101.607086, 186.0, 66.3570603, 92.21387, 86.573051, 85.0741786]),
    (lambda: [x * 1e6 for x in summation.axis_totals_rad(TERMS["temporal"], 0.99)], [197.552658, 158.480602]),
    (lambda: [summation.sigma_multiple(0.9), summation.sigma_multiple(0.9973)], [1.64485363, 2.99997699]),
])  # fmt: skip
def test_sums_of_errors_unlike_each_other(found, expected):
    assert list(found()) == pytest.approx(expected, rel=1e-6, abs=0.0, nan_ok=True)


@pytest.mark.parametrize(
    ("found", "expected"),
    [
        (
            lambda: [error_classes.basis(each) for each in MIXED],
            [
                "bias, bound, about each axis: mean error, constant; worst-case satellite (temporal)",
                "random, 2-sigma, radial: mean 0, standard deviation error / (2 sqrt(2)) over time",
                (
                    "drift, 3-sigma, about one axis: ramp from zero to error, mean 1/2 and standard deviation "
                    "1/sqrt(12) of it; worst-case satellite (temporal)"
                ),
                (
                    "transient, 1-sigma, about each axis: mean 3 error, counted as always present; worst-case "
                    "satellite (temporal)"
                ),
            ],
        ),
        (
            lambda: [error_classes.basis(each, "mixed") for each in MIXED],
            [
                (
                    "bias, bound, about each axis: mean 0, standard deviation error / sqrt(3), evenly up to "
                    "the bound; random satellite at a random time (mixed)"
                ),
                (
                    "random, 2-sigma, radial: mean 0, standard deviation error / (2 sqrt(2)); random satellite "
                    "at a random time (mixed)"
                ),
                (
                    "drift, 3-sigma, about one axis: mean 0, standard deviation error / 3 / sqrt(3), ramp from "
                    "zero; random satellite at a random time (mixed)"
                ),
                (
                    "transient, 1-sigma, about each axis: mean 0, standard deviation error / 1, counted as "
                    "always present; random satellite at a random time (mixed)"
                ),
            ],
        ),
        (
            lambda: [
                error_classes.basis(stated("bias", "1-sigma", "radial")),
                error_classes.basis(stated("random", "bound", "x")),
            ],
            [
                (
                    "bias, 1-sigma, radial: mean 3 error / sqrt(2) about each axis, constant; worst-case "
                    "satellite (temporal)"
                ),
                (
                    "random, bound, about one axis: mean 0, standard deviation error / sqrt(3), evenly up to "
                    "the bound over time"
                ),
            ],
        ),
        (
            lambda: [
                f"{each.rule}: {each.name}, {each.caveat}" for each in summation.summations(TERMS["temporal"], 0.95)
            ],
            [
                "rss: root sum square, not authorised: mount, heat, slew have means, and means add linearly",
                (
                    "esa-1993: class by class, ECSS-E-ST-60-10C (2008) A.2.3: no mathematical justification, "
                    "can overestimate; not recommended (4.2.3 NOTE 8)"
                ),
                "ecss-axis: ECSS, one axis, ",
                "ecss-radial: ECSS, two axes, ",
                (
                    "rayleigh: ECSS, two like axes, does not apply: the mean is not 10 times below the "
                    "standard deviation"
                ),
                "exact: radial distribution, ",
            ],
        ),
    ],
)
def test_the_words_of_each_error_say_its_class_and_its_formula(found, expected):
    assert found() == expected


@pytest.mark.parametrize(("found", "expected"), [
    (lambda: [x * 1e6 for each in summation.allocate(MIXED, 300.0 * URAD, rule="ecss-radial",
            confidence=0.95) for x in (each.stated_rad, each.largest_rad, each.missing_rad)],
     [
        41.0, 91.6145627, 0.0, 73.0, 148.886899, 0.0, 55.0, 148.087147, 0.0, 17.0, 33.8715209, 0.0,
    ]),
    (lambda: [x * 1e6 for each in summation.allocate(MIXED, 150.0 * URAD, rule="exact", confidence=0.9,
            interpretation="mixed") for x in (each.largest_rad, each.missing_rad)],
     [107.814018, 0.0, 178.44691, 0.0, 407.164777, 0.0, 60.0273893, 0.0]),
    (lambda: [x * 1e6 for each in summation.allocate(MIXED, 97.5 * URAD, rule="ecss-radial",
            confidence=0.95) for x in (each.largest_rad, each.missing_rad)],
     [0.0, 74.126021, 0.0, 84.4305767, 0.0, 104.146333, 0.0, 60.3464263]),
])  # fmt: skip
def test_what_a_total_leaves_for_each_error(found, expected):
    assert list(found()) == pytest.approx(expected, rel=1e-6, abs=0.0, nan_ok=True)


@pytest.mark.parametrize(
    ("call", "error", "words"),
    [
        (
            lambda: StatedError("mount", -2.5e-6, "bias", "bound", "x"),
            ValueError,
            "mount: the error is -2.5 µrad: it must be finite, at least 0 rad; it is a half width",
        ),
        (
            lambda: StatedError("mount", 2.5e-6, "noise", "bound", "x"),
            ValueError,
            'mount: no kind "noise"; give one of bias, random, drift, transient',
        ),
        (
            lambda: StatedError("mount", 2.5e-6, "bias", "4-sigma", "x"),
            ValueError,
            'mount: no statistic "4-sigma"; give one of 1-sigma, 2-sigma, 3-sigma, bound',
        ),
        (
            lambda: StatedError("mount", 2.5e-6, "bias", "bound", "y"),
            ValueError,
            'mount: no axes "y"; give one of per-axis, radial, x',
        ),
        (lambda: error_term(MIXED[0], "worst"), ValueError, 'no interpretation "worst"; give one of temporal, mixed'),
        (lambda: term(mean=(0.0, math.inf)), ValueError, "term: the mean is inf rad: it must be finite"),
        (
            lambda: term(sigma=(1e-6, -2.5e-6)),
            ValueError,
            "term: the standard deviation is -2.5 µrad: it must be finite, at least 0 rad",
        ),
        (
            lambda: summation.allocate(MIXED, -3e-6, rule="exact", confidence=0.9),
            ValueError,
            "the total is -3 µrad: it must be finite, above 0 rad; else nothing is left to allocate",
        ),
        (
            lambda: summation.allocate(MIXED, 3e-6, rule="linear", confidence=0.9),
            ValueError,
            'no rule "linear" to allocate by; give one of rss, esa-1993, ecss-axis, ecss-radial, exact',
        ),
        (
            lambda: summation.sigma_multiple(1.5),
            ValueError,
            "the confidence is 1.5: it must be finite, above 0 and below 1",
        ),
    ],
)
def test_a_refusal_of_a_stated_error_says_its_name(call, error, words):
    with pytest.raises(error) as refused:
        call()
    assert str(refused.value) == words


WORDS = [
    "random bound radial",
    "random bound x",
    "bias 2-sigma radial",
    "bias 1-sigma x",
    "drift bound per-axis",
    "drift 1-sigma radial",
    "transient bound radial",
    "transient 3-sigma x",
]
EACH = [stated(*each.split(), (11.0 + 7.0 * at) * URAD, f"{each.split()[0]} {at}") for at, each in enumerate(WORDS)]


@pytest.mark.parametrize(("found", "expected"), [
    (lambda: [x * 1e6 for one in EACH for x in error_term(one).mean_rad],
     "0 0 0 0 26.5165043 26.5165043 96 0 19.5 19.5 48.7903679 48.7903679 37.4766594 37.4766594 60 0"),
    (lambda: [x * 1e6 for one in EACH for x in error_term(one).sigma_rad],
     "5.5 5.5 10.3923048 0 0 0 0 0 11.2583302 11.2583302 28.169132 28.169132 0 0 0 0"),
    (lambda: [x * 1e6 for one in EACH for x in error_term(one, "mixed").sigma_rad],
     "5.5 5.5 10.3923048 0 8.83883476 8.83883476 32 0 13 13 18.7794214 18.7794214 26.5 26.5 20 0"),
    (lambda: [error_term(one).gaussian for one in EACH], "0 0 1 1 0 0 1 1"),
    (lambda: [error_term(one, "mixed").gaussian for one in EACH], "0 0 1 1 0 0 0 1"),
    (lambda: [each.total_rad * 1e6 for each in summation.summations([error_term(one) for one in EACH], 0.683)],
     "110.181668 202.066679 320.83901 362.035643 49.3165578 334.023616"),
    (lambda: [each.total_rad * 1e6 for each in summation.summations([error_term(one, "mixed") for one in EACH], 0.5)],
     "110.181668 202.066679 36.0980693 43.6941485 63.0138984 52.7177597"),
    (lambda: [x * 1e6 for each in summation.allocate(MIXED, 2.9e-4, rule="ecss-radial", confidence=0.95) for x in
            (each.largest_rad, each.missing_rad)],
     "84.5149133 0 138.436022 0 136.436428 0 31.5049711 0"),
    (lambda: [x * 1e6 for each in summation.allocate(MIXED, 9e-5, rule="rss", confidence=0.95) for x in
            (each.largest_rad, each.missing_rad)],
     "0 2.96773634 55.7225269 0 28.3019434 0 0 10.1748471"),
    (lambda: [x * 1e6 for each in summation.allocate(MIXED, 1.9e-4, rule="esa-1993", confidence=0.95,
            interpretation="mixed") for x in (each.largest_rad, each.missing_rad)],
     "45 0 77 0 59 0 21 0"),
    (lambda: [each.largest_rad * 1e6 for each in summation.allocate(MIXED, 9.5e-5, rule="exact", confidence=0.9,
            interpretation="mixed")],
     "53.3429185 91.8381468 153.464054 26.0222146"),
])  # fmt: skip
def test_sums_of_errors_at_their_edges_have_these_numbers(found, expected):
    assert list(found()) == pytest.approx([float(each) for each in expected.split()], rel=1e-6, abs=0.0, nan_ok=True)


@pytest.mark.parametrize(("found", "expected"), [
    (lambda: error_classes.basis(EACH[0]),
     "random, bound, radial: mean 0, standard deviation error / 2, evenly over a disc over time"),
    (lambda: error_classes.basis(EACH[1]),
     "random, bound, about one axis: mean 0, standard deviation error / sqrt(3), evenly up to the bound over time"),
    (lambda: error_classes.basis(EACH[2]),
     "bias, 2-sigma, radial: mean 1.5 error / sqrt(2) about each axis, constant; worst-case satellite (temporal)"),
    (lambda: error_classes.basis(EACH[3]),
     "bias, 1-sigma, about one axis: mean 3 error, constant; worst-case satellite (temporal)"),
    (lambda: error_classes.basis(EACH[4]),
     "drift, bound, about each axis: ramp from zero to error, mean 1/2 and standard deviation 1/sqrt(12) of it; "
     "worst-case satellite (temporal)"),
    (lambda: error_classes.basis(EACH[5]),
     "drift, 1-sigma, radial: ramp from zero to 3 error / sqrt(2) about each axis, mean 1/2 and standard "
     "deviation 1/sqrt(12) of it; worst-case satellite (temporal)"),
    (lambda: error_classes.basis(EACH[6]),
     "transient, bound, radial: mean error / sqrt(2) about each axis, counted as always present; worst-case "
     "satellite (temporal)"),
    (lambda: error_classes.basis(EACH[7]),
     "transient, 3-sigma, about one axis: mean error, counted as always present; worst-case satellite (temporal)"),
    (lambda: error_classes.basis(EACH[0], "mixed"),
     "random, bound, radial: mean 0, standard deviation error / 2, evenly over a disc; random satellite at a "
     "random time (mixed)"),
    (lambda: error_classes.basis(EACH[1], "mixed"),
     "random, bound, about one axis: mean 0, standard deviation error / sqrt(3), evenly up to the bound; random "
     "satellite at a random time (mixed)"),
    (lambda: error_classes.basis(EACH[2], "mixed"),
     "bias, 2-sigma, radial: mean 0, standard deviation error / (2 sqrt(2)); random satellite at a random time "
     "(mixed)"),
    (lambda: error_classes.basis(EACH[3], "mixed"),
     "bias, 1-sigma, about one axis: mean 0, standard deviation error / 1; random satellite at a random time "
     "(mixed)"),
    (lambda: error_classes.basis(EACH[4], "mixed"),
     "drift, bound, about each axis: mean 0, standard deviation error / sqrt(3) / sqrt(3), evenly up to the "
     "bound, ramp from zero; random satellite at a random time (mixed)"),
    (lambda: error_classes.basis(EACH[5], "mixed"),
     "drift, 1-sigma, radial: mean 0, standard deviation error / (1 sqrt(2)) / sqrt(3), ramp from zero; random "
     "satellite at a random time (mixed)"),
    (lambda: error_classes.basis(EACH[6], "mixed"),
     "transient, bound, radial: mean 0, standard deviation error / 2, evenly over a disc, counted as always "
     "present; random satellite at a random time (mixed)"),
    (lambda: error_classes.basis(EACH[7], "mixed"),
     "transient, 3-sigma, about one axis: mean 0, standard deviation error / 3, counted as always present; "
     "random satellite at a random time (mixed)"),
    (lambda: "; ".join(each.caveat for each in summation.summations([error_term(one, "mixed") for one in EACH], 0.5)),
     "not authorised: the half widths are not the same number of standard deviations; ECSS-E-ST-60-10C (2008) "
     "A.2.3: no mathematical justification, can overestimate; not recommended (4.2.3 NOTE 8); approximate: "
     "transient 6 is not Gaussian and holds more than half of the variance; below the exact radial error, as at "
     "confidences under 0.79; does not apply: the two standard deviations differ by more than 10 %; approximate: "
     "transient 6 is not Gaussian and holds more than half of the variance"),
    (lambda: "; ".join(each.caveat for each in summation.summations([error_term(one) for one in EACH[:2]], 0.9)),
     "not authorised: the half widths are not the same number of standard deviations; ECSS-E-ST-60-10C (2008) "
     "A.2.3: no mathematical justification, can overestimate; not recommended (4.2.3 NOTE 8); approximate: "
     "random 1 is not Gaussian and holds more than half of the variance; approximate: random 1 is not Gaussian "
     "and holds more than half of the variance; does not apply: the two standard deviations differ by more than "
     "10 %; approximate: random 1 is not Gaussian and holds more than half of the variance"),
    (lambda: "; ".join(each.caveat for each in summation.summations([error_term(one) for one in EACH[2:3]], 0.9)),
     "not authorised: bias 2 has a mean, and means add linearly; ECSS-E-ST-60-10C (2008) A.2.3: no mathematical "
     "justification, can overestimate; not recommended (4.2.3 NOTE 8); ; ; does not apply: the mean is not 10 "
     "times below the standard deviation; "),
    (lambda: "; ".join(each.note for each in summation.allocate(MIXED, 9e-5, rule="rss", confidence=0.95)),
     "nothing is left: the other lines alone exceed the total by 2.968 µrad; ; ; nothing is left: the other "
     "lines alone exceed the total by 10.17 µrad"),
    (lambda: summation.rayleigh_caveat([ErrorTerm("a", "random", 1e-6, (0.0, 0.0), (1e-6, 0.9e-6))]), ""),
    (lambda: summation.rayleigh_caveat([ErrorTerm("a", "random", 1e-6, (0.0, 0.0), (1e-6, 0.89e-6))]),
     "does not apply: the two standard deviations differ by more than 10 %"),
    (lambda: summation.rayleigh_caveat([ErrorTerm("a", "random", 1e-6, (-0.1e-6, 0.0), (1e-6, 0.99e-6))]),
     "does not apply: the mean is not 10 times below the standard deviation"),
    (lambda: summation.rayleigh_caveat([ErrorTerm("a", "random", 1.0, (0.25, 0.0), (2.5, 2.5))]), ""),
])  # fmt: skip
def test_a_stated_error_says_what_is_taken_for_it(found, expected):
    assert found() == expected


@pytest.mark.parametrize(("found", "expected"), [
    (lambda: stated("random", "bound", "radial", -1e-6, "a"),
     "a: the error is -1 µrad: it must be finite, at least 0 rad; it is a half width"),
    (lambda: stated("noise", "bound", "radial", 1e-6, "a"),
     'a: no kind "noise"; give one of bias, random, drift, transient'),
    (lambda: stated("random", "4-sigma", "radial", 1e-6, "a"),
     'a: no statistic "4-sigma"; give one of 1-sigma, 2-sigma, 3-sigma, bound'),
    (lambda: stated("random", "bound", "y", 1e-6, "a"), 'a: no axes "y"; give one of per-axis, radial, x'),
    (lambda: error_term(EACH[0], "ensemble"), 'no interpretation "ensemble"; give one of temporal, mixed'),
    (lambda: ErrorTerm("a", "bias", 1e-6, (0.0,), (0.0, 0.0)),
     "a: the mean is (0.0,) rad; give two values, for axis x and axis y"),
    (lambda: ErrorTerm("a", "bias", 1e-6, (0.0, 0.0), (0.0, -1e-6)),
     "a: the standard deviation is -1 µrad: it must be finite, at least 0 rad"),
    (lambda: ErrorTerm("a", "bias", 1e-6, (0.0, math.nan), (0.0, 0.0)), "a: the mean is nan rad: it must be finite"),
    (lambda: summation.summations([], 0.9), "the pointing budget has 0 terms; give at least 1"),
    (lambda: summation.sigma_multiple(1.0), "the confidence is 1: it must be finite, above 0 and below 1"),
    (lambda: summation.rayleigh_total_rad(TERMS["mixed"], 0.0),
     "the confidence is 0: it must be finite, above 0 and below 1"),
    (lambda: summation.exact_total_rad(TERMS["mixed"], 1.5),
     "the confidence is 1.5: it must be finite, above 0 and below 1"),
])  # fmt: skip
def test_a_refusal_of_a_stated_error_is_one_whole_sentence(found, expected):
    with pytest.raises((ValueError, ArithmeticError)) as refused:
        found()
    assert str(refused.value) == expected


def test_each_rule_says_what_it_is_of_its_formula_and_who_authorises_it():
    terms = [ErrorTerm("one", "random", 3e-6, (0.0, 0.0), (1e-6, 1e-6))]
    ecss, alone = "ECSS-E-ST-60-10C (2008)", "terms uncorrelated"
    found = summation.summations(terms, 0.9)
    assert [(each.rule, each.name, each.of, each.formula, each.authority) for each in found] == [
        ("rss", "root sum square", "stated", "sqrt(sum of error^2)",
         f"the paper, section 2.1; {ecss} 4.2.3 only for uncorrelated deviations of one level without a mean"),
        ("esa-1993", "class by class", "stated", "sum over the classes of sqrt(sum of error^2)",
         "earlier ESA practice, Pointing Error Handbook ESA-NCR-502 (1993)"),
        ("ecss-axis", "ECSS, one axis", "axis", "abs(sum of means) + n_p sqrt(sum of sigma^2), the worse axis",
         f"{ecss} 4.2.3 and 4.2.4.1; {alone}"),
        ("ecss-radial", "ECSS, two axes", "radial", "sqrt(mean_x^2 + mean_y^2) + n_p sqrt(sigma_x^2 + sigma_y^2)",
         f"{ecss} 4.2.3 and 4.2.4.2.1, which calls it extremely conservative; {alone}"),
        ("rayleigh", "ECSS, two like axes", "radial", "max(sigma_x, sigma_y) sqrt(-2 ln(1 - P))",
         f"{ecss} 4.2.4.2.2, means far below the deviations"),
        ("exact", "radial distribution", "radial", "P(r < total) = P of a Gaussian about the mean, axes independent",
         "the reference for the rules; a sum of many errors (central limit theorem)"),
    ]  # fmt: skip


def test_means_and_unlike_deviations_are_found_about_either_axis():
    like = ErrorTerm("like", "random", 3.0, (0.0, 0.0), (1.0, 1.0))
    across = ErrorTerm("across", "bias", 2.0, (0.0, -2.0), (0.0, 0.0))
    along = ErrorTerm("along", "bias", 1.0, (1.0, 0.0), (0.0, 0.0))
    assert summation.rss_caveat([like, across]) == "not authorised: across has a mean, and means add linearly"
    many = [across, like, along]
    assert summation.rss_caveat(many) == "not authorised: across, along have means, and means add linearly"
    for sigma in ((1.0, 0.5), (0.5, 1.0)):
        unlike = ErrorTerm("unlike", "random", 3.0, (0.0, 0.0), sigma)
        said = "not authorised: the half widths are not the same number of standard deviations"
        assert summation.rss_caveat([unlike]) == summation.rss_caveat([like, unlike]) == said
    for mean in ((0.2, 0.0), (0.0, 0.2), (0.0, -0.2), (-0.2, 0.01)):
        off = ErrorTerm("off", "random", 3.0, mean, (1.0, 1.0))
        said = "does not apply: the mean is not 10 times below the standard deviation"
        assert summation.rayleigh_caveat([off]) == said


@pytest.mark.parametrize("turned", [False, True])
def test_a_shape_that_rules_about_one_axis_alone_is_named_whichever_axis_that_is(turned):
    def of(name, sigma, gaussian):
        return ErrorTerm(name, "random", 3.0, (0.0, 0.0), sigma[::-1] if turned else sigma, gaussian)

    small, large = of("small", (0.1, 0.2), False), of("large", (0.3, 3.0), False)
    normal = of("normal", (2.0, 1.0), True)
    said = "approximate: large is not Gaussian and holds more than half of the variance"
    assert summation.shape_caveat([small, normal, large]) == said
    assert summation.shape_caveat([small, normal]) == ""
