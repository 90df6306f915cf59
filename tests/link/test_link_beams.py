"""Gains and beams against integrals done otherwise, against published numbers, and against their limits."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import dblquad, quad
from scipy.optimize import minimize_scalar
from scipy.special import j0, j1, jn_zeros

from microrad.link import gains
from microrad.link.beams import BEST_TRUNCATION, GaussianFall, LitAperture
from microrad.mission.fields import Quantity
from microrad.mission.tables.link import narrowest_radius

D, WAVELENGTH = 0.05, 1.55e-6
UNIFORM_DB = 20 * math.log10(math.pi * D / WAVELENGTH)
EVEN = LitAperture(D, WAVELENGTH, 0.0, 0.0)
SHAPES = [(0.0, 0.0), (0.0, 0.3), (0.4, 0.0), (BEST_TRUNCATION, 0.0), (0.95, 0.2), (2.0, 0.0), (2.5, 0.1), (6.0, 0.05)]


def lit(truncation, obscuration=0.0, m_squared=1.0):
    return LitAperture(D, WAVELENGTH, truncation, obscuration, m_squared)


def angle(x):
    """The error at which the Bessel function's argument at the aperture's edge is x."""
    return x * WAVELENGTH / (math.pi * D)


def field(truncation, obscuration, x):
    """The diffraction integral by adaptive quadrature."""

    def ring(rho):
        return math.exp(-((truncation * rho) ** 2)) * j0(x * rho) * rho

    return quad(ring, obscuration, 1.0, limit=500, epsabs=1e-13)[0]


# ---- aperture: gain on the axis
@pytest.mark.promise("readme-7")
@pytest.mark.parametrize(("truncation", "obscuration"), SHAPES)
def test_gain_is_that_of_the_diffraction_integral(truncation, obscuration):
    # G = 4 pi / lambda^2 |field's integral|^2 / power before the aperture; radius 1, field exp(-(a rho)^2)
    over_area = 2 * math.pi * field(truncation, obscuration, 0.0)
    power = math.pi / (2 * truncation**2) if truncation else math.pi * (1 - obscuration**2)
    gain = 4 * math.pi * (D / 2 / WAVELENGTH) ** 2 * over_area**2 / power
    assert lit(truncation, obscuration).gain_db == pytest.approx(10 * math.log10(gain), abs=1e-9)


def test_the_best_truncation_is_that_of_klein_and_degnan():
    found = minimize_scalar(lambda a: -lit(a).efficiency, bounds=(0.5, 2.0), method="bounded", options={"xatol": 1e-8})
    assert found.x == pytest.approx(1.1209, abs=5e-5)
    assert found.x == pytest.approx(BEST_TRUNCATION, abs=5e-5)
    assert lit(1.1209).efficiency == pytest.approx(0.81453, abs=5e-6)
    assert lit(1.1209).gain_db - UNIFORM_DB == pytest.approx(-0.891, abs=5e-4)


def test_the_best_truncation_behind_an_obscuration_is_that_of_their_series():
    # Klein and Degnan 1974: alpha = 1.12 - 1.30 e^2 + 2.12 e^4
    for hole in (0.1, 0.2, 0.3):
        best = minimize_scalar(lambda a, e=hole: -lit(a, e).efficiency, bounds=(0.3, 2.0), method="bounded")
        assert best.x == pytest.approx(1.12 - 1.30 * hole**2 + 2.12 * hole**4, abs=0.01)
        brute = max(
            (2 / a**2) * (math.exp(-(a**2)) - math.exp(-((a * hole) ** 2))) ** 2 for a in np.linspace(0.5, 1.5, 2001)
        )
        assert -best.fun == pytest.approx(brute, abs=1e-6)


@pytest.mark.promise("link-13")
@settings(deadline=None)
@given(st.floats(1e-4, 5.0), st.floats(0.0, 0.95))
def test_no_beam_has_more_gain_than_even_light_over_the_same_opening(truncation, obscuration):
    truncation = min(truncation, 0.999 / narrowest_radius(obscuration) if obscuration else truncation)
    shape = lit(truncation, obscuration)
    assert 0.0 < shape.efficiency <= shape.passed * (1.0 - obscuration**2) * (1.0 + 1e-12)
    assert lit(0.0, obscuration).efficiency == 1.0 - obscuration**2


def test_little_truncation_does_not_cancel():
    # to first order 2 a^2: a beam far wider than the aperture
    assert lit(1e-6).efficiency == pytest.approx(2e-12, rel=1e-9, abs=0.0)
    assert lit(1e-6, 0.5).efficiency == pytest.approx(2e-12 * 0.75**2, rel=1e-9, abs=0.0)


def test_an_uncut_beam_is_the_gaussian_of_half_angle_lambda_over_pi_w():
    for truncation in (4.0, 40.0, 1000.0):
        half = WAVELENGTH / (math.pi * (D / 2 / truncation))
        shape = lit(truncation)
        assert shape.half_angle_rad == pytest.approx(half, rel=1e-5)
        assert shape.gain_db == pytest.approx(gains.gaussian_beam_gain_db(half), abs=1e-5)
        assert shape.passed == pytest.approx(1.0, abs=1e-12)
        errors = np.linspace(0.0, 2.0, 9) * half
        np.testing.assert_allclose(shape.loss_db(errors), GaussianFall(half).loss_db(errors), atol=2e-3)


# ---- aperture: off the axis
def test_even_light_has_the_airy_pattern():
    x = np.array([0.5, 1.0, 2.0, 3.0, 5.0, 7.0, 30.0, 119.0, 121.0, 500.0, 5000.0])
    expected = -20 * np.log10(np.abs(2 * j1(x) / x))
    np.testing.assert_allclose(EVEN.loss_db(angle(x)), expected, rtol=0, atol=1e-7)


def test_the_first_null_stands_at_1_22_lambda_over_d():
    null = jn_zeros(1, 1)[0] / math.pi * WAVELENGTH / D
    assert null == pytest.approx(1.21967 * WAVELENGTH / D, rel=1e-5)
    assert float(EVEN.loss_db(null)) > 250.0
    assert float(EVEN.loss_db(null * 1.01)) < float(EVEN.loss_db(null * 1.0001))


@pytest.mark.parametrize(("truncation", "obscuration"), SHAPES)
def test_loss_is_that_of_the_diffraction_integral_near_and_far(truncation, obscuration):
    on_axis, shape = field(truncation, obscuration, 0.0), lit(truncation, obscuration)
    for x in (0.3, 1.7, 4.4, 12.3, 60.0, 117.0, 123.0, 180.0):
        amplitude = abs(field(truncation, obscuration, x) / on_axis)
        if amplitude > 1e-9:  # below it the adaptive quadrature is noise
            assert float(shape.loss_db(angle(x))) == pytest.approx(-20 * math.log10(amplitude), abs=5e-3)
        else:
            assert float(shape.loss_db(angle(x))) > 170.0


def test_loss_is_that_of_a_two_dimensional_fourier_integral():
    a, e, x = 1.1, 0.25, 2.6

    def real_part(phi, rho):
        return math.exp(-((a * rho) ** 2)) * math.cos(x * rho * math.cos(phi)) * rho

    total = dblquad(real_part, e, 1.0, 0.0, 2 * math.pi)[0]
    whole = 2 * math.pi * quad(lambda r: math.exp(-((a * r) ** 2)) * r, e, 1.0)[0]
    assert float(lit(a, e).loss_db(angle(x))) == pytest.approx(-20 * math.log10(abs(total / whole)), abs=1e-7)


@pytest.mark.promise("link-14")
@pytest.mark.parametrize(("truncation", "obscuration", "m_squared"), [(1.12, 0.0, 1.0), (1.5, 0.2, 1.0), (2.0, 0, 1.4)])
def test_the_far_field_carries_the_power_that_passes(truncation, obscuration, m_squared):
    shape = lit(truncation, obscuration, m_squared)
    theta = np.linspace(0.0, angle(400.0) * m_squared, 40001)
    gain = 10 ** ((shape.gain_db - shape.loss_db(theta)) / 10)
    within = np.trapezoid(gain * theta / 2.0, theta)
    # an edge scatters about 1 / x of its light beyond the argument x
    assert shape.passed * (1 - 3e-3) < within < shape.passed * (1 + 1e-6)
    expected = math.exp(-2 * (truncation * obscuration) ** 2) - math.exp(-2 * truncation**2)
    assert shape.passed == pytest.approx(expected, rel=1e-12)


def test_m_squared_stretches_the_angles_and_takes_its_square_from_the_gain():
    ideal, real = lit(1.2, 0.1), lit(1.2, 0.1, 1.5)
    assert real.gain_db == pytest.approx(ideal.gain_db - 20 * math.log10(1.5), abs=1e-12)
    assert real.half_angle_rad == pytest.approx(1.5 * ideal.half_angle_rad, rel=1e-12)
    errors = np.linspace(0.0, 60e-6, 13)
    np.testing.assert_allclose(real.loss_db(1.5 * errors), ideal.loss_db(errors), rtol=1e-9, atol=1e-9)
    assert (real.efficiency, real.passed) == (ideal.efficiency, ideal.passed)


@pytest.mark.parametrize(("truncation", "obscuration"), SHAPES)
def test_near_the_axis_every_beam_is_the_gaussian_of_its_half_angle(truncation, obscuration):
    shape = lit(truncation, obscuration)
    for share, within in ((0.01, 1e-3), (0.1, 2e-2)):
        error = share * shape.half_angle_rad
        expected = float(GaussianFall(shape.half_angle_rad).loss_db(error))
        assert float(shape.loss_db(error)) == pytest.approx(expected, rel=within)


def test_even_light_has_a_half_angle_of_two_root_two_lambda_over_pi_d():
    assert EVEN.half_angle_rad == pytest.approx(math.sqrt(8.0) * WAVELENGTH / (math.pi * D), rel=1e-12)


# ---- the loss turned round
@settings(deadline=None)
@given(st.floats(0.0, 4.0), st.floats(0.0, 0.3), st.floats(1e-3, 45.0))
def test_error_rad_turns_the_loss_round_within_the_main_lobe(truncation, obscuration, loss):
    shape = lit(truncation, obscuration)
    error = shape.error_rad(loss)
    assert float(shape.loss_db(error)) == pytest.approx(loss, abs=1e-5)
    inside = np.linspace(0.0, error * (1 - 1e-6), 200)
    assert np.all(shape.loss_db(inside) < loss)


@pytest.mark.parametrize("loss", [46.0, 60.0, 100.0, 200.0])
def test_a_loss_as_deep_as_a_null_is_found_before_the_null(loss):
    # such a stretch is narrower than any search in steps
    null = float(jn_zeros(1, 1)[0])
    assert EVEN.error_rad(loss) == pytest.approx(angle(null), rel=0.03)
    assert EVEN.error_rad(loss) < angle(null) * (1 + 1e-9)


@pytest.mark.parametrize("loss", [1e-16, 1e-15, 1e-13, 1e-9, 0.99e-6, 1.01e-6])
@pytest.mark.parametrize("truncation", [0.0, 0.5, 1.1, 2.0])
def test_a_loss_near_nothing_is_turned_round_as_well(loss, truncation):
    shape = lit(truncation)
    assert shape.error_rad(loss) == pytest.approx(
        shape.half_angle_rad * math.sqrt(loss / 8.685889638), rel=1e-4, abs=0.0
    )


def test_no_loss_is_no_error_and_one_out_of_reach_is_infinite():
    for shape in (EVEN, lit(1.1), GaussianFall(10e-6)):
        assert shape.error_rad(0.0) == 0.0
        assert shape.error_rad(-1.0) == 0.0
        if isinstance(shape, LitAperture):
            assert shape.error_rad(299.0) < math.inf
            assert shape.error_rad(301.0) == math.inf


def test_a_gaussian_fall_is_8_686_times_the_squared_ratio_both_ways():
    fall = GaussianFall(20e-6)
    assert float(fall.loss_db(20e-6)) == pytest.approx(8.686, abs=5e-4)
    assert fall.error_rad(8.685889638) == pytest.approx(20e-6, rel=1e-9)
    assert fall.loss_db(np.zeros((2, 3))).shape == (2, 3)


def test_losses_keep_the_shape_of_the_errors_and_are_exactly_zero_on_the_axis():
    errors = np.linspace(0.0, 400e-6, 24).reshape(2, 3, 4)
    for shape in (EVEN, lit(1.1, 0.2)):
        losses = shape.loss_db(errors)
        assert losses.shape == errors.shape
        assert losses[0, 0, 0] == 0.0
        assert math.copysign(1.0, float(shape.loss_db(0.0))) == 1.0
        flat = np.array([float(shape.loss_db(e)) for e in errors.ravel()])
        np.testing.assert_allclose(losses.ravel(), flat, rtol=0, atol=1e-6)
        assert shape.loss_db(np.empty(0)).shape == (0,)
        assert np.isfinite(float(shape.loss_db(math.inf)))


def test_many_errors_are_taken_in_pieces_that_agree():
    errors = np.linspace(0.0, 300e-6, 20001)
    shape = lit(1.1, 0.2)
    np.testing.assert_allclose(shape.loss_db(errors)[::2000], shape.loss_db(errors[::2000]), rtol=0, atol=1e-6)


@pytest.mark.parametrize(
    ("changes", "limit"),
    [
        ({"diameter_m": 0.0}, r"LitAperture\.diameter_m is 0 m: it must be finite, above 0 m"),
        ({"wavelength_m": -1.0}, r"LitAperture\.wavelength_m is -1 m: it must be finite, above 0 m"),
        ({"truncation": -0.1}, r"LitAperture\.truncation is -0\.1: it must be finite, at least 0"),
        ({"truncation": math.nan}, r"LitAperture\.truncation is nan: it must be finite, at least 0"),
        ({"obscuration": 1.0}, r"LitAperture\.obscuration is 1: it must be finite, at least 0 and below 1"),
        ({"obscuration": -0.1}, r"LitAperture\.obscuration is -0\.1: it must be finite, at least 0 and below 1"),
        ({"m_squared": 0.99}, r"LitAperture\.m_squared is 0\.99: it must be finite, at least 1"),
        ({"truncation": 30.0, "obscuration": 0.9}, r"truncation is 30: it must be finite, at most 1\.68603"),
    ],
)
def test_what_is_no_lit_aperture_is_refused(changes, limit):
    good = {"diameter_m": D, "wavelength_m": WAVELENGTH, "truncation": 1.0, "obscuration": 0.0}
    with pytest.raises(ValueError, match=limit):
        LitAperture(**{**good, **changes})


def test_a_beam_of_which_one_hundredth_passes_the_obscuration_is_taken():
    most = 1.0 / narrowest_radius(0.3)
    assert lit(most * (1 - 1e-9), 0.3).passed == pytest.approx(0.01, rel=1e-6)
    with pytest.raises(ValueError, match=r"obscuration of 0\.3"):
        lit(most * (1 + 1e-6), 0.3)


# ---- gains and losses
@pytest.mark.promise("link-20")
@pytest.mark.parametrize(("elevation", "printed"), [(90.0, 1.0), (30.0, 1.9943), (10.0, 5.586), (0.0, 37.92)])
def test_air_mass_of_kasten_and_young(elevation, printed):
    # Kasten and Young 1989: 0.50572, 6.07995 deg, 1.6364; the horizon has 37.9
    assert gains.air_mass(math.radians(elevation)) == pytest.approx(printed, rel=5e-4)


@pytest.mark.parametrize("elevation", [-0.1, 90.1, math.nan])
def test_an_elevation_beyond_horizon_or_zenith_is_refused(elevation):
    with pytest.raises(ValueError, match="is not between 0 and 90 deg, horizon and zenith"):
        gains.air_mass(math.radians(elevation))


@pytest.mark.promise("readme-7")
@pytest.mark.promise("link-20")
def test_a_clear_sky_costs_its_zenith_times_the_air_mass():
    assert gains.clear_sky_loss_db(0.5, math.pi / 2) == pytest.approx(3.0103, abs=2e-3)
    at_thirty = gains.clear_sky_loss_db(0.8, math.radians(30.0))
    assert 10 ** (-at_thirty / 10) == pytest.approx(0.8 ** gains.air_mass(math.radians(30.0)), rel=1e-12)
    assert gains.clear_sky_loss_db(1.0, math.radians(30.0)) == 0.0


@pytest.mark.parametrize("transmission", [0.0, -0.1, 1.01, math.nan])
def test_a_sky_that_adds_light_or_lets_none_through_is_refused(transmission):
    with pytest.raises(ValueError, match=r"the transmission is .*: it must be finite, above 0, at most 1; 1 is vacuum"):
        gains.clear_sky_loss_db(transmission, 1.0)


def test_strehl_of_a_wavefront_error():
    # a fourteenth of a wave rms is the diffraction limit by convention, Strehl 0.8
    assert gains.strehl_ratio(WAVELENGTH / 14, WAVELENGTH) == pytest.approx(0.8176, abs=1e-4)
    assert gains.strehl_ratio(0.0, WAVELENGTH) == 1.0
    small = 1e-3
    assert gains.strehl_ratio(small * WAVELENGTH, WAVELENGTH) == pytest.approx(1 - (2 * math.pi * small) ** 2, abs=1e-8)


@pytest.mark.parametrize(
    ("strehl", "convention", "said"),
    [
        (1.01, "ratio", r"the Strehl ratio is 1\.01: it must be finite, above 0, at most 1"),
        (0.0, "ratio", r"the Strehl ratio is 0: it must be finite, above 0, at most 1"),
        (math.nan, "ratio", r"the Strehl ratio is nan: it must be finite, above 0, at most 1"),
        (-0.1, "decibel", r"the Strehl loss is -0\.1 dB: it must be finite, at least 0 dB"),
        (math.nan, "decibel", r"the Strehl loss is nan dB: it must be finite, at least 0 dB"),
    ],
)
def test_a_strehl_that_amplifies_is_refused(strehl, convention, said):
    with pytest.raises(ValueError, match=said):
        gains.strehl_loss_db(strehl, convention)


def test_a_perfect_wavefront_loses_nothing():
    assert str(gains.strehl_loss_db(1.0, "ratio")) == "0.0"
    assert gains.strehl_loss_db(0.0, "decibel") == 0.0


def test_an_obscuration_takes_its_area():
    assert gains.obscuration_loss_db(0.0) == 0.0
    assert gains.obscuration_loss_db(math.sqrt(0.5)) == pytest.approx(3.0103, abs=1e-4)
    for hole in (1.0, -0.1, 1.5, math.nan):
        with pytest.raises(ValueError, match=r"the obscuration is .*: it must be finite, at least 0 and below 1"):
            gains.obscuration_loss_db(hole)


@pytest.mark.promise("link-57")
def test_a_terminal_measured_before_flight():
    # LUCE engineering model: 90 mW, 9.4 urad full angle at 1/e2, 560 MW/sr measured
    assert gains.peak_radiant_intensity_w_sr(0.09, 4.7e-6) == pytest.approx(2.594e9, rel=2e-4)
    assert gains.implied_transmission_db(560e6, 0.09, 4.7e-6) == pytest.approx(-6.66, abs=0.005)
    gain = 10 ** (gains.gaussian_beam_gain_db(4.7e-6) / 10)
    assert gains.peak_radiant_intensity_w_sr(0.09, 4.7e-6) == pytest.approx(0.09 * gain / (4 * math.pi), rel=1e-12)


def test_a_peak_above_the_lossless_beams_is_refused():
    ideal = gains.peak_radiant_intensity_w_sr(0.09, 4.7e-6)
    assert gains.implied_transmission_db(ideal, 0.09, 4.7e-6) == 0.0
    for peak in (ideal * 1.001, 0.0, -1.0, math.nan):
        with pytest.raises(ValueError, match=r"at most 2\.594e\+09 W/sr, which 90 mW in a half angle of 4\.7 .rad at"):
            gains.implied_transmission_db(peak, 0.09, 4.7e-6)


def test_the_far_field_begins_at_twice_the_squared_aperture_over_the_wavelength():
    assert gains.far_field_m(0.15, 1.55e-6) == pytest.approx(29.032e3, rel=1e-4)


SHAPED = LitAperture(0.061, 1.31e-6, 0.83, 0.27, 1.4)


@pytest.mark.parametrize(("found", "expected"), [
    (lambda: [SHAPED.efficiency, SHAPED.passed, SHAPED.gain_db, SHAPED.half_angle_rad],
     [0.585000434, 0.652305277, 98.0531694, 2.74150793e-05]),
    (lambda: SHAPED.loss_db([0.0, 3e-6, 11e-6, 40e-6, 9e-4]),
     [0.0, 0.104230981, 1.44046687, 21.8700873, 66.3577295]),
    (lambda: [SHAPED.error_rad(loss) for loss in (0.0, 0.4, 3.0, 17.0)],
     [0.0, 5.85926781e-06, 1.56136871e-05, 3.13448258e-05]),
    (lambda: [GaussianFall(17e-6).error_rad(2.3), GaussianFall(17e-6).error_rad(-1.0),
            *GaussianFall(17e-6).loss_db([5e-6, -9e-6])],
     [8.74793779e-06, 0.0, 0.751374536, 2.4344535]),
    (lambda: [gains.aperture_gain_db(0.23, 1.31e-6), gains.gaussian_beam_gain_db(17e-6),
            gains.free_space_loss_db(3.7e7, 1.31e-6), gains.far_field_m(0.23, 1.31e-6)],
     [114.832128, 104.421921, 291.002806, 80763.3588]),
    (lambda: [gains.peak_radiant_intensity_w_sr(2.3, 17e-6), gains.implied_transmission_db(3.1e9, 2.3,
            17e-6)],
     [5066524140.0, -2.13348422]),
    (lambda: [float(gains.pointing_loss_db(3e-6, 0.061, 1.31e-6, each)) for each in ("gaussian", "gain")],
     [0.418228524, 0.836457048]),
    (lambda: [gains.strehl_loss_db(0.37, "ratio"), gains.strehl_loss_db(0.37, "decibel"),
            gains.strehl_ratio(83e-9, 1.31e-6), gains.obscuration_loss_db(0.27)],
     [4.31798276, 0.37, 0.853440385, 0.328734189]),
    (lambda: [gains.air_mass(0.31), gains.clear_sky_loss_db(0.87, 0.31), gains.rayleigh_depth(0.85e-6,
            830.0), gains.aerosol_depth(0.85e-6, 0.12, 1.3)],
     [3.2480476, 1.96444347, 0.0151134589, 0.148230182]),
    (lambda: [gains.photon_energy_j(1.31e-6) * 1e19, gains.dbm(0.023), gains.watt(-47.3)],
     [1.51637088, 13.6172784, 1.86208714e-08]),
])  # fmt: skip
def test_beams_and_gains_of_numbers_unlike_each_other(found, expected):
    assert list(found()) == pytest.approx(expected, rel=1e-6, abs=0.0, nan_ok=True)


@pytest.mark.parametrize(
    ("call", "error", "words"),
    [
        (
            lambda: gains.implied_transmission_db(6.1e9, 2.3, 17e-6),
            ValueError,
            (
                "a peak of 6.1e+09 W/sr is not above 0 and at most 5.067e+09 W/sr, which 2.3 W in a half "
                "angle of 17 µrad at 1/e2 reach without loss; check the convention of the divergence"
            ),
        ),
        (
            lambda: gains.pointing_loss_db(3e-6, 0.061, 1.31e-6, "pattern"),
            ValueError,
            'pointing-loss convention "pattern" is neither "gaussian" nor "gain"',
        ),
        (
            lambda: gains.strehl_loss_db(1.25, "ratio"),
            ValueError,
            "the Strehl ratio is 1.25: it must be finite, above 0, at most 1; 1 is a perfect wavefront",
        ),
        (
            lambda: gains.strehl_loss_db(0.37, "percent"),
            ValueError,
            'Strehl convention "percent" is neither "decibel" nor "ratio"',
        ),
        (
            lambda: gains.clear_sky_loss_db(1.25, 0.31),
            ValueError,
            "the transmission is 1.25: it must be finite, above 0, at most 1; 1 is vacuum",
        ),
        (
            lambda: gains.obscuration_loss_db(1.5),
            ValueError,
            "the obscuration is 1.5: it must be finite, at least 0 and below 1; 1 is the whole aperture",
        ),
        (
            lambda: gains.air_mass(-0.31),
            ValueError,
            "an elevation of -17.7617 deg is not between 0 and 90 deg, horizon and zenith",
        ),
        (
            lambda: LitAperture(0.061, 1.31e-6, 9.5, 0.9),
            ValueError,
            ("truncation is 9.5: it must be finite, at most 1.68603; an obscuration of 0.9 stops the rest of the beam"),
        ),
        (
            lambda: LitAperture(0.061, 1.31e-6, 0.83, 0.27, 0.75),
            ValueError,
            "LitAperture.m_squared is 0.75: it must be finite, at least 1; 1 is an ideal beam",
        ),
    ],
)
def test_a_refusal_of_a_gain_says_its_numbers(call, error, words):
    with pytest.raises(error) as refused:
        call()
    assert str(refused.value) == words


@pytest.mark.parametrize(("found", "expected"), [
    (lambda: [(b := LitAperture(0.21, 9.3e-7, 7.5, 0.06, 1.4)).gain_db, b.passed, b.efficiency, b.half_angle_rad],
     "97.8453457 0.666976811 0.0237147311 2.69954476e-05"),
    (lambda: LitAperture(0.21, 9.3e-7, 7.5, 0.06, 1.4).loss_db([[0.0, 4e-6], [2.7e-5, 9e-4]]).ravel(),
     "0 0.191026537 9.7294603 52.9894967"),
    (lambda: LitAperture(0.21, 9.3e-7, 0.0, 0.4).loss_db([0.0, 3e-6, 1.8e-4, 6.1e-4, 0.3]),
     "0 6.77122434 58.2736441 71.292035 150.946098"),
    (lambda: LitAperture(0.21, 9.3e-7, 1.3, 0.4, 2.5).loss_db([-5e-6, 5e-6, 4.4e-4, 9.9e-3]),
     "2.22470086 2.22470086 61.6054756 97.2704985"),
    (lambda: [(b := LitAperture(0.21, 9.3e-7, 0.0, 0.4)).gain_db, b.passed, b.efficiency, b.half_angle_rad],
     "116.260517 1 0.84 3.70194345e-06"),
    (lambda: [(b := LitAperture(0.21, 9.3e-7, 1e-3, 0.4)).gain_db, b.passed, b.efficiency, b.half_angle_rad],
     "58.513605 1.67999805e-06 1.41119836e-06 3.70194364e-06"),
    (lambda: [LitAperture(0.21, 9.3e-7, 1.3, 0.4, 2.5).error_rad(x) for x in (-1.0, 0.0, 5e-7, 2e-6, 0.7, 14.0)],
     "0 0 2.43121168e-09 4.86242326e-09 2.85418376e-06 1.07706288e-05"),
    (lambda: [LitAperture(0.21, 9.3e-7, 7.5, 0.06, 1.4).error_rad(x) for x in (3.0, 21.0, 301.0)],
     "1.56368835e-05 3.58307137e-05 inf"),
    (lambda: [GaussianFall(7e-6).error_rad(x) for x in (-3.0, 0.0, 8.685889638)], "0 0 7e-06"),
    (lambda: GaussianFall(7e-6).loss_db([-7e-6, 0.0, 1.4e-5]), "8.68588964 0 34.7435586"),
    (lambda: [gains.gaussian_pointing_loss_db(x, 5e-6) for x in (0.0, -3e-6, 1e-5)], "0 3.12692027 34.7435586"),
    (lambda: [gains.pointing_loss_db(2e-6, 0.13, 1.31e-6, each) for each in ("gaussian", "gain")],
     "0.844224916 1.68844983"),
    (lambda: [gains.pointing_db_per_rad2(0.13, 1.31e-6, each) for each in ("gain", "gaussian")],
     "422112458000 211056229000"),
    (lambda: [gains.strehl_loss_db(0.37, "ratio"), gains.strehl_loss_db(0.37, "decibel"), gains.strehl_loss_db(1.0,
            "ratio")],
     "4.31798276 0.37 -0"),
    (lambda: [gains.strehl_ratio(9e-8, 1.31e-6), gains.strehl_ratio(0.0, 1.31e-6), gains.obscuration_loss_db(0.37)],
     "0.829992748 1 0.639388834"),
    (lambda: [gains.air_mass(math.radians(x)) for x in (0.0, 7.0, 90.0, 90.0 + 1e-10)],
     "37.9196084 7.72811703 0.999711992 0.999711992"),
    (lambda: [gains.clear_sky_loss_db(0.61, 0.3), gains.clear_sky_loss_db(1.0, 0.3)], "7.19275581 0"),
    (lambda: [gains.rayleigh_depth(4.3e-7, 1730.0), gains.rayleigh_depth(1.55e-6, -120.0), gains.aerosol_depth(4.3e-7,
            0.07, 1.6)],
     "0.21741715 0.00151296821 0.270114881"),
    (lambda: [gains.aerosol_depth(1e-6, 0.07, 1.6), gains.aerosol_depth(4.3e-7, 0.07, 0.0)], "0.07 0.07"),
    (lambda: [gains.photon_energy_j(8.3e-7), gains.dbm(3.7e-5), gains.watt(-17.3), gains.watt(0.0), gains.dbm(1.0)],
     "2.39330826e-19 -14.3179828 1.86208714e-05 0.001 30"),
    (lambda: [gains.peak_radiant_intensity_w_sr(0.7, 9e-6), gains.implied_transmission_db(2.2e9, 0.7, 9e-6)],
     "5501652350 -3.98070463"),
    (lambda: [gains.far_field_m(0.13, 1.31e-6), gains.free_space_loss_db(4.4e7, 1.31e-6), gains.aperture_gain_db(0.13,
            1.31e-6)],
     "25801.5267 292.507825 109.876439"),
])  # fmt: skip
def test_beams_that_are_cut_hard_or_hardly_at_all_have_these_numbers(found, expected):
    assert list(found()) == pytest.approx([float(each) for each in expected.split()], rel=1e-6, abs=0.0, nan_ok=True)


@pytest.mark.parametrize(("found", "expected"), [
    (lambda: LitAperture(0.21, 9.3e-7, 2.6, 0.7),
     "truncation is 2.6: it must be finite, at most 2.16775; an obscuration of 0.7 stops the rest of the beam"),
    (lambda: LitAperture(0.21, 9.3e-7, -0.1, 0.0),
     "LitAperture.truncation is -0.1: it must be finite, at least 0; 0 is an even light"),
    (lambda: LitAperture(0.21, 9.3e-7, 1.0, 1.0),
     "LitAperture.obscuration is 1: it must be finite, at least 0 and below 1"),
    (lambda: LitAperture(0.0, 9.3e-7, 1.0, 0.0), "LitAperture.diameter_m is 0 m: it must be finite, above 0 m"),
    (lambda: LitAperture(0.21, -9.3e-7, 1.0, 0.0), "LitAperture.wavelength_m is -930 nm: it must be finite, above 0 m"),
    (lambda: LitAperture(0.21, 9.3e-7, 1.0, 0.0, 0.9),
     "LitAperture.m_squared is 0.9: it must be finite, at least 1; 1 is an ideal beam"),
    (lambda: gains.checked("the error", [[1.0], [2.5]], Quantity("rad", most=2.0), "it is small"),
     "the error is 2.5 rad: it must be finite, at most 2 rad; it is small"),
    (lambda: gains.checked("the error", [1.0, math.nan], Quantity("rad")), "the error is nan rad: it must be finite"),
    (lambda: gains.checked("the power", [1.0, 1e-31, 3.0], Quantity("W", above=0.0)),
     "the power is below 1e-30 W, which nothing is: check unit and scale"),
    (lambda: gains.checked("the error", [-1.0, 5.0], Quantity("rad", least=0.0, most=2.0)),
     "the error is -1 rad: it must be finite, at least 0 rad, at most 2 rad"),
    (lambda: gains.implied_transmission_db(0.0, 0.7, 9e-6),
     "a peak of 0 W/sr is not above 0 and at most 5.502e+09 W/sr, which 700 mW in a half angle of 9 µrad at 1/e2 "
     "reach without loss; check the convention of the divergence"),
    (lambda: gains.implied_transmission_db(5.6e9, 0.7, 9e-6),
     "a peak of 5.6e+09 W/sr is not above 0 and at most 5.502e+09 W/sr, which 700 mW in a half angle of 9 µrad "
     "at 1/e2 reach without loss; check the convention of the divergence"),
    (lambda: gains.air_mass(-0.01), "an elevation of -0.572958 deg is not between 0 and 90 deg, horizon and zenith"),
    (lambda: gains.air_mass(1.6), "an elevation of 91.6732 deg is not between 0 and 90 deg, horizon and zenith"),
    (lambda: gains.strehl_loss_db(0.5, "db"), 'Strehl convention "db" is neither "decibel" nor "ratio"'),
    (lambda: gains.strehl_loss_db(-0.5, "decibel"), "the Strehl loss is -0.5 dB: it must be finite, at least 0 dB"),
    (lambda: gains.strehl_loss_db(1.01, "ratio"),
     "the Strehl ratio is 1.01: it must be finite, above 0, at most 1; 1 is a perfect wavefront"),
    (lambda: gains.pointing_db_per_rad2(0.13, 1.31e-6, "pattern"),
     'pointing-loss convention "pattern" is neither "gaussian" nor "gain"'),
    (lambda: gains.obscuration_loss_db(1.0),
     "the obscuration is 1: it must be finite, at least 0 and below 1; 1 is the whole aperture"),
    (lambda: gains.obscuration_loss_db(-0.1),
     "the obscuration is -0.1: it must be finite, at least 0 and below 1; 1 is the whole aperture"),
    (lambda: gains.clear_sky_loss_db(0.0, 1.0),
     "the transmission is 0: it must be finite, above 0, at most 1; 1 is vacuum"),
    (lambda: gains.clear_sky_loss_db(0.5, -0.1),
     "an elevation of -5.72958 deg is not between 0 and 90 deg, horizon and zenith"),
])  # fmt: skip
def test_a_refusal_of_a_beam_or_a_gain_is_one_whole_sentence(found, expected):
    with pytest.raises((ValueError, ArithmeticError)) as refused:
        found()
    assert str(refused.value) == expected


@pytest.mark.parametrize("loss", [30.0, 56.0, 58.0, 150.0, 250.0])
def test_a_beam_that_the_aperture_hardly_cuts_falls_as_a_gaussian_far_below_its_first_lobe(loss):
    """The errors looked at come in parts: 57 dB is where the second one begins."""
    shape = LitAperture(0.1, 1e-6, 6.0, 0.0, 1.0)
    expected = GaussianFall(shape.half_angle_rad).error_rad(loss)
    assert shape.error_rad(loss) == pytest.approx(expected, rel=1e-4)
    assert float(shape.loss_db(shape.error_rad(loss))) == pytest.approx(loss, abs=0.01)


@pytest.mark.parametrize("obscuration", [2.0 / 3.0, 0.71234567])
def test_a_refusal_of_a_beam_that_is_stopped_has_six_digits_of_an_obscuration_that_has_more(obscuration):
    with pytest.raises(ValueError) as refused:
        LitAperture(0.21, 9.3e-7, 5.0, obscuration)
    most = 1.0 / narrowest_radius(obscuration)
    assert str(refused.value) == (
        f"truncation is 5: it must be finite, at most {most:.6g}; an obscuration of "
        f"{'0.666667' if obscuration < 0.7 else '0.712346'} stops the rest of the beam"
    )
