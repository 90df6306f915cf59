"""Distribution of the radial error against closed forms, other quadrature and a million draws; and the refusals."""

import math
from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.special import erfc
from scipy.stats import ncx2, norm

from microrad.link.radial_error import (
    Jitter,
    density_on_circle,
    radial_cdf,
    radial_quantile,
    radial_steps,
    radial_survival,
)

URAD = 1e-6
EQUAL = Jitter((0.0, 0.0), (3.0 * URAD, 3.0 * URAD))
UNEQUAL = Jitter((0.0, 0.0), (1.0 * URAD, 4.0 * URAD))
BIASED = Jitter((-3.0 * URAD, 5.0 * URAD), (2.5 * URAD, 1.0 * URAD))
ONE_AXIS = Jitter((2.0 * URAD, 1.0 * URAD), (0.0, 3.0 * URAD))
STILL = Jitter((3.0 * URAD, -4.0 * URAD), (0.0, 0.0))
KINDS = {"equal": EQUAL, "unequal": UNEQUAL, "biased": BIASED, "one axis": ONE_AXIS}
each_kind = pytest.mark.parametrize("jitter", KINDS.values(), ids=KINDS.keys())


def swapped(jitter):
    return Jitter(jitter.bias_rad[::-1], jitter.rms_rad[::-1])


@pytest.mark.parametrize("p", [1e-20, 1e-3, 0.005, 0.5, 0.99])
def test_equal_axes_without_bias_are_the_rayleigh_law(p):
    radius = 3.0 * URAD * math.sqrt(-2.0 * math.log(p))
    assert float(radial_quantile(EQUAL, p)) == pytest.approx(radius, rel=1e-13)
    assert float(radial_survival(EQUAL, radius)) == pytest.approx(p, rel=1e-13, abs=0.0)
    assert float(radial_cdf(EQUAL, radius)) == pytest.approx(-math.expm1(math.log(p)), rel=1e-13)
    nearly = Jitter((0.0, 0.0), (3.0 * URAD, 3.0 * (1.0 + 1e-13) * URAD))  # by quadrature
    assert float(radial_survival(nearly, radius)) == pytest.approx(p, rel=1e-11, abs=0.0)
    assert float(radial_quantile(nearly, p)) == pytest.approx(radius, rel=1e-11)


def test_a_radius_far_beyond_a_tiny_rms_is_never_exceeded():
    tiny = Jitter((0.0, 0.0), (1e-200, 1e-200))
    assert (float(radial_survival(tiny, 1e-3)), float(radial_cdf(tiny, 1e-3))) == (0.0, 1.0)


@each_kind
def test_a_million_draws_agree_within_the_99_percent_interval(jitter):
    draws = 1_000_000
    normal = np.random.Generator(np.random.Philox(key=7)).standard_normal((draws, 2))
    radius = np.hypot(*(jitter.bias_rad + normal * jitter.rms_rad).T)
    points = radial_quantile(jitter, [0.99, 0.9, 0.5, 0.1, 0.01])
    p = radial_cdf(jitter, points)
    wide = norm.isf(0.005 / 5)  # the interval covers the 5 figures of a case together
    assert np.all(np.abs(np.mean(radius[:, None] < points, axis=0) - p) <= wide * np.sqrt(p * (1.0 - p) / draws))


@pytest.mark.promise("link-37")
@pytest.mark.parametrize("bias_in_rms", [0.0, 0.3, 3.0, 12.0])
def test_equal_axes_with_bias_follow_the_noncentral_chi_squared_into_the_tails(bias_in_rms):
    rms = 2.0 * URAD
    jitter = Jitter((0.6 * bias_in_rms * rms, -0.8 * bias_in_rms * rms), (rms, rms))
    radius = (bias_in_rms + np.array([0.05, 0.5, 1.0, 2.0, 4.0, 7.0])) * rms
    chi = ncx2(2, bias_in_rms**2)
    wanted = chi.sf((radius / rms) ** 2)
    survival = radial_survival(jitter, radius)
    np.testing.assert_allclose(survival, wanted, atol=1e-10)
    sure = wanted > 1e-9  # scipy's own digits end below
    np.testing.assert_allclose(survival[sure], wanted[sure], rtol=1e-6)
    np.testing.assert_allclose(radial_cdf(jitter, radius), chi.cdf((radius / rms) ** 2), atol=1e-10)


def survival_by_quad(jitter, radius):
    """P(r > R) in polar angle: along each ray the joint Gaussian is integrated from R on, in closed form."""
    (b_x, b_y), (s_x, s_y) = jitter.bias_rad, jitter.rms_rad

    def ray(angle):
        c, s = math.cos(angle), math.sin(angle)
        a = (c / s_x) ** 2 + (s / s_y) ** 2
        middle = (c * b_x / s_x**2 + s * b_y / s_y**2) / a
        height = math.exp(-0.5 * ((b_x / s_x) ** 2 + (b_y / s_y) ** 2 - a * middle**2))
        x = radius - middle
        gauss = math.exp(-0.5 * a * x**2) / a
        tail = middle * math.sqrt(math.pi / (2.0 * a)) * erfc(x * math.sqrt(a / 2.0))
        return height * (gauss + tail) / (2.0 * math.pi * s_x * s_y)

    corners = np.linspace(0.0, 2.0 * math.pi, 17)
    return sum(quad(ray, *pair, epsabs=0.0, epsrel=1e-12)[0] for pair in pairwise(corners))


@pytest.mark.parametrize("order", [lambda jitter: jitter, swapped], ids=["as is", "swapped"])
@pytest.mark.parametrize("jitter", [UNEQUAL, BIASED, Jitter((4.0 * URAD, 1.0 * URAD), (0.2 * URAD, 2.0 * URAD))])
def test_unequal_axes_agree_with_quadrature_in_polar_angle_down_to_a_survival_of_1e_12(jitter, order):
    case = order(jitter)
    radius = radial_quantile(case, [0.9, 0.5, 1e-2, 1e-6, 1e-12])
    wanted = [survival_by_quad(case, r) for r in radius]
    np.testing.assert_allclose(radial_survival(case, radius), wanted, rtol=1e-9)
    np.testing.assert_allclose(wanted, [0.9, 0.5, 1e-2, 1e-6, 1e-12], rtol=1e-9)


@pytest.mark.parametrize("jitter", [*KINDS.values(), Jitter((1e-3, 2e-3), (1e-6, 3e-8)), STILL])
def test_survival_and_distribution_add_up_to_one(jitter):
    radius = np.abs(jitter.static_rad + np.linspace(-6.1, 6.1, 90) * (max(jitter.rms_rad) + URAD / 7))
    survival, below = radial_survival(jitter, radius), radial_cdf(jitter, radius)
    assert min(survival.min(), below.min()) >= 0.0 and max(survival.max(), below.max()) <= 1.0
    total = survival + below
    np.testing.assert_allclose(total, 1.0, atol=1e-12)


def test_one_axis_without_bias_is_the_error_function():
    jitter = Jitter((0.0, 0.0), (0.0, 2.0 * URAD))
    radius = np.array([0.0, 0.1, 2.0, 15.0]) * URAD
    wanted = erfc(radius / (2.0 * URAD * math.sqrt(2.0)))
    np.testing.assert_allclose(radial_survival(jitter, radius), wanted, rtol=1e-13)
    nearly = Jitter((0.0, 0.0), (1e-12, 2.0 * URAD))
    np.testing.assert_allclose(radial_survival(nearly, radius), wanted, rtol=1e-9)


def test_a_static_error_is_exceeded_below_itself_only():
    assert radial_survival(STILL, [4.99 * URAD, 5.01 * URAD]).tolist() == [1.0, 0.0]
    assert radial_cdf(STILL, [4.99 * URAD, 5.01 * URAD]).tolist() == [0.0, 1.0]
    assert radial_quantile(STILL, [0.1, 0.9]) == pytest.approx([5.0 * URAD] * 2)


def test_the_quantile_stands_far_out_on_a_narrow_axis_and_at_zero_without_error():
    # along the bias the error is 1000 times smaller than across it, where it hardly changes the radius
    narrow = Jitter((1000 * URAD, 0.0), (0.001 * URAD, 1.0 * URAD))
    radius = radial_quantile(narrow, [1e-20, 0.5])
    np.testing.assert_allclose(radial_survival(narrow, radius), [1e-20, 0.5], rtol=1e-7)
    assert float(radial_quantile(Jitter((0.0, 0.0), (0.0, 0.0)), 0.5)) == 0.0


@each_kind
def test_the_quantile_turns_the_survival_round_and_keeps_shapes(jitter):
    p = np.array([[1e-20, 1e-12, 1e-3], [0.5, 0.99, 1.0 - 1e-9]])
    radius = radial_quantile(jitter, p)
    assert radius.shape == p.shape
    np.testing.assert_allclose(radial_survival(jitter, radius), p, rtol=1e-9)


def by_polar_quadrature(radius, jitter):
    """P(r < R) as the integral of the joint density over the disc."""
    node, weight = np.polynomial.legendre.leggauss(200)
    r = radius * (1 + node)[:, None] / 2
    angle = np.linspace(0, 2 * math.pi, 400, endpoint=False)
    (b_x, b_y), (s_x, s_y) = jitter.bias_rad, jitter.rms_rad
    density = norm.pdf(r * np.cos(angle), b_x, s_x) * norm.pdf(r * np.sin(angle), b_y, s_y)
    return float(np.sum(density.mean(axis=1) * 2 * math.pi * r[:, 0] * weight) * radius / 2)


@pytest.mark.parametrize(
    "jitter",
    [
        Jitter((0.0, 0.0), (300e-3, 300e-3)),
        Jitter((100e-3, -250e-3), (300e-3, 300e-3)),
        Jitter((0.0, 0.0), (300e-3, 120e-3)),
        Jitter((150e-3, 90e-3), (80e-3, 300e-3)),
    ],
)
def test_the_distribution_is_the_integral_of_the_density_over_the_disc(jitter):
    for radius in (0.05, 0.39, 0.9):
        assert float(radial_cdf(jitter, radius)) == pytest.approx(by_polar_quadrature(radius, jitter), rel=1e-11)


def test_nearly_equal_axes_join_the_equal_ones_and_a_thin_axis_leaves_a_line():
    bias = (90 * URAD, 20 * URAD)
    equal = float(radial_cdf(Jitter(bias, (300 * URAD, 300 * URAD)), 400 * URAD))
    nearly = float(radial_cdf(Jitter(bias, (300 * URAD, 300.0001 * URAD)), 400 * URAD))
    assert nearly == pytest.approx(equal, rel=1e-6)
    thin = float(radial_cdf(Jitter((0.0, 0.0), (300 * URAD, 1e-3 * URAD)), 400 * URAD))
    assert thin == pytest.approx(math.erf(400 / 300 / math.sqrt(2)), rel=1e-8)
    beside = float(radial_cdf(Jitter((0.0, 250 * URAD), (300 * URAD, 1e-3 * URAD)), 400 * URAD))
    assert beside == pytest.approx(math.erf(math.sqrt(400**2 - 250**2) / 300 / math.sqrt(2)), rel=1e-8)


@pytest.mark.promise("link-37")
@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: Jitter((0.0, math.nan), (1e-6, 1e-6)), r"the bias is nan rad: it must be finite"),
        (lambda: Jitter((0.0, 0.0), (math.inf, 1e-6)), r"the jitter rms is inf rad: it must be finite, at least 0 rad"),
        (lambda: Jitter((0.0, 0.0, 0.0), (1e-6, 1e-6)), r"the bias is .* rad; give two values, for axis x and axis y"),
        (lambda: Jitter((0.0, 0.0), (1e-6, -1e-6)), r"the jitter rms is -1 µrad: it must be finite, at least 0 rad"),
        (lambda: radial_survival(EQUAL, [0.0, -1e-6]), r"the radial error is -1 µrad: .* at least 0 rad"),
        (lambda: radial_cdf(EQUAL, math.inf), r"the radial error is inf rad: it must be finite, at least 0 rad"),
        (lambda: radial_quantile(EQUAL, 1.0), r"the probability is 1: it must be finite, at least 1e-20 and below 1"),
        (lambda: radial_quantile(EQUAL, 0.99e-20), r"the probability is 9\.9e-21: .* below 1"),
        (lambda: radial_quantile(EQUAL, math.nan), r"the probability is nan: .* below 1"),
    ],
)
def test_what_is_no_error_no_radius_and_no_probability_is_refused(call, message):
    with pytest.raises(ValueError, match=message):
        call()


@pytest.mark.parametrize(
    ("bias", "rms"),
    [((1.0, 0.0), (0.7, 0.7)), ((0.0, 1.0), (0.7, 0.7)), ((0.3, -0.2), (0.4, 0.9)), ((0.3, 0.9), (0.9, 0.4))],
)
def test_directions_on_a_circle_belong_to_their_axes(bias, rms):
    """Mean squared direction cosine towards x on a circle, by a sum over the angle; also where both axes are alike."""
    radius = np.array([0.4, 1.1])
    square_x, square_y, density = density_on_circle(Jitter(bias, rms), radius)
    angle = np.linspace(0.0, 2.0 * np.pi, 20_001)[:-1]
    x, y = radius[:, None] * np.cos(angle), radius[:, None] * np.sin(angle)
    weight = np.exp(-0.5 * ((x - bias[0]) / rms[0]) ** 2 - 0.5 * ((y - bias[1]) / rms[1]) ** 2)
    exact = np.sum(weight * np.cos(angle) ** 2, axis=1) / np.sum(weight, axis=1)
    np.testing.assert_allclose(np.sum(square_x * density, axis=1) / np.sum(density, axis=1), exact, rtol=1e-9)
    np.testing.assert_allclose(square_x + square_y, 1.0, rtol=1e-12)


SKEW = Jitter((1.3 * URAD, -2.6 * URAD), (0.9 * URAD, 2.1 * URAD))
LINE = Jitter((1.3 * URAD, -2.6 * URAD), (2.1 * URAD, 0.0))


@pytest.mark.parametrize(("found", "expected"), [
    (lambda: [SKEW.static_rad, *radial_survival(SKEW, [0.0, 1e-6, 4e-6, 9e-6]), *radial_cdf(SKEW,
            [0.3e-6, 4e-6])],
     [
        2.90688837e-06, 1.0, 0.950348233, 0.312543163, 0.00147980036, 0.00396074478, 0.687456837,
    ]),
    (lambda: [*radial_quantile(SKEW, [1e-6, 0.02, 0.9]), *radial_quantile(LINE, [1e-6, 0.02, 0.9])],
     [
        1.26956384e-05, 7.11351443e-06, 1.37208562e-06, 1.15783324e-05, 6.20491851e-06, 2.61956236e-06,
    ]),
    (lambda: [*radial_survival(LINE, [2e-6, 3e-6, 6e-6]), *radial_cdf(LINE, [2.7e-6, 6e-6])],
     [1.0, 0.554166101, 0.0259396996, 0.225574295, 0.9740603]),
    (lambda: [float(np.sum(density_on_circle(SKEW, np.array(3e-6))[2])),
            *(float(np.sum(each * density_on_circle(SKEW,
            np.array(3e-6))[2])) for each in density_on_circle(SKEW, np.array(3e-6))[:2])],
     [241645.417, 79492.7792, 162152.638]),
    (lambda: [(s := radial_steps(SKEW))[0].size, float(s[0] @ s[1]), float(s[0] ** 2 @ s[1]),
            float(s[1].sum()), float(s[0][-1]), *radial_steps(Jitter((3e-6, 4e-6), (0.0, 0.0)))[0]],
     [4000, 3.322226e-06, 1.36700041e-11, 1.0, 2.8103375e-05, 5e-06]),
])  # fmt: skip
def test_probabilities_of_axes_unlike_each_other(found, expected):
    assert list(found()) == pytest.approx(expected, rel=1e-6, abs=0.0, nan_ok=True)


UPRIGHT = Jitter((-1.2 * URAD, 0.8 * URAD), (0.0, 1.7 * URAD))
NARROW = Jitter((2.4 * URAD, -0.5 * URAD), (1.9 * URAD, 2e-9 * URAD))
AT_REST = Jitter((3.0 * URAD, -4.0 * URAD), (0.0, 0.0))


@pytest.mark.parametrize(("found", "expected"), [
    (lambda: [*radial_survival(UPRIGHT, [0.0, 1.2e-6, 2e-6, 7e-6]), *radial_cdf(UPRIGHT, [1.2e-6, 2e-6, 7e-6])],
     "1 1 0.397977032 0.000170815315 0 0.602022968 0.999829185"),
    (lambda: radial_quantile(UPRIGHT, [[0.5, 1e-12], [0.99, 1e-20]]).ravel(),
     "1.75323998e-06 1.28151094e-05 1.20023603e-06 1.65894535e-05"),
    (lambda: [*radial_survival(NARROW, [2e-6, 2.6e-6, 9e-6]), *radial_cdf(NARROW, [2e-6, 2.6e-6])],
     "0.607599844 0.472809351 0.00026377077 0.392400172 0.527190646"),
    (lambda: radial_quantile(NARROW, [0.3, 1e-5]), "3.43907788e-06 1.0515187e-05"),
    (lambda: radial_survival(AT_REST, [4.9e-6, 5e-6, 5.1e-6]), "1 0 0"),
    (lambda: radial_cdf(AT_REST, [4.9e-6, 5e-6, 5.1e-6]), "0 1 1"),
    (lambda: radial_quantile(AT_REST, [0.2, 0.9]), "5e-06 5e-06"),
    (lambda: [(s := radial_steps(UPRIGHT))[0].size, s[0] @ s[1], s[0] ** 2 @ s[1], s[1].sum(), s[0][0], s[0][-1]],
     "4000 2.04538865e-06 4.96994625e-12 1 2.73027756e-09 2.18394902e-05"),
    (lambda: [(s := radial_steps(Jitter((0.0, 0.0), (3e-6, 3e-6))))[0].size, s[0] @ s[1], s[0][-1], s[1].sum()],
     "4000 3.75994241e-06 3.59955e-05 1"),
    (lambda: radial_survival(Jitter((0.0, 0.0), (3e-6, 3e-6)), [0.0, 4e-6, 1e-4, 1.0]),
     "1 0.411112291 5.31236408e-242 0"),
    (lambda: radial_cdf(Jitter((0.0, 0.0), (3e-6, 3e-6)), [0.0, 1e-12, 4e-6, 1.0]), "0 5.55555556e-14 0.588887709 1"),
    (lambda: radial_survival(Jitter((-8e-6, 8e-6), (2e-6, 2e-6)), [1e-6, 1e-5, 1.3e-5, 2.5e-5]),
     "0.999999969 0.773788811 0.223512797 5.80057895e-12"),
    (lambda: radial_cdf(Jitter((-8e-6, 8e-6), (2e-6, 2e-6)), [1e-7, 1e-6, 1e-5]),
     "1.41991297e-10 3.12242772e-08 0.226211189"),
    (lambda: [np.sum(x) for x in density_on_circle(Jitter((1e-6, 2e-6), (3e-6, 1e-6)), np.array([2e-6]))],
     "192 192 216822.083"),
])  # fmt: skip
def test_errors_of_one_axis_and_of_hardly_any_have_their_probabilities(found, expected):
    assert list(found()) == pytest.approx([float(each) for each in expected.split()], rel=1e-6, abs=0.0, nan_ok=True)


@pytest.mark.parametrize("rms", [(0.0, 0.0), (2e-6, 1e-6)])
def test_steps_that_all_share_are_made_once_and_nobody_writes_into_them(rms):
    jitter = Jitter((3e-6, -4e-6), rms)
    radius, share = radial_steps(jitter)
    assert radial_steps(Jitter((3e-6, -4e-6), rms))[0] is radius
    for each in (radius, share):
        with pytest.raises(ValueError, match="read-only"):
            each[0] = 1.0
