"""Turbulence in closed form: published digits, integrals over the spectrum, drawn powers, and what is refused."""

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.integrate import quad
from scipy.special import j1, jv

from microrad.link.turbulence import (
    BuftonWind,
    Downlink,
    GammaGamma,
    HufnagelValley,
    LogNormal,
    SlantPath,
    Uplink,
    Wandering,
    seeing,
)

ZENITH = SlantPath(HufnagelValley(), 0.5e-6, math.pi / 2.0, 500e3)
LOW = SlantPath(HufnagelValley(ground_strength=5e-15, wind_rms_m_s=18.0), 1.55e-6, math.radians(35.0), 900e3)
WIND = BuftonWind(slew_rad_s=5e-3)


def over_height(function, path=LOW):
    """Integral over height of a function of height and distance, times Cn2, along a path; by an adaptive quadrature."""
    longer = 1.0 / math.sin(path.elevation_rad)
    edges = [0.0, 50.0, 200.0, 1e3, 4e3, 9e3, 15e3, 25e3, 60e3]
    total = 0.0
    for low, high in itertools.pairwise(edges):
        total += quad(
            lambda h: float(path.profile.strength(h)) * function(h, h * longer) * longer, low, high, epsrel=1e-9
        )[0]
    return total


@pytest.mark.promise("link-101")
def test_the_5_7_profile_has_its_published_lengths():
    assert f"{100.0 * ZENITH.fried_m:.4f}" == "4.9606"
    assert f"{1e6 * ZENITH.isoplanatic_rad:.3f}" == "6.894"
    k = 2.0 * math.pi / 0.5e-6
    ended = quad(lambda h: float(ZENITH.profile.strength(h)) * h ** (5.0 / 3.0), 0.0, 20e3, limit=200, epsrel=1e-9)[0]
    assert f"{1e6 * (2.914 * k**2 * ended) ** -0.6:.3f}" == "7.011"


@pytest.mark.promise("link-101")
def test_lengths_and_variances_are_integrals_along_the_path():
    k = LOW.wavenumber
    assert k == 2.0 * math.pi / 1.55e-6
    assert_allclose(LOW.fried_m, (0.423 * k**2 * over_height(lambda h, z: 1.0)) ** -0.6, rtol=1e-7)
    assert_allclose(LOW.isoplanatic_rad, (2.914 * k**2 * over_height(lambda h, z: z ** (5 / 3))) ** -0.6, rtol=1e-7)
    assert_allclose(LOW.rytov, 2.25 * k ** (7 / 6) * over_height(lambda h, z: z ** (5 / 6)), rtol=1e-7)
    between = over_height(lambda h, z: (z * (1.0 - z / 900e3)) ** (5 / 6))
    assert_allclose(LOW.spherical_rytov, 2.25 * k ** (7 / 6) * between, rtol=1e-7)
    speed = over_height(lambda h, z: float(WIND.speed_m_s(h)) ** (5 / 3))
    assert_allclose(LOW.greenwood_hz(WIND), (0.1022 * k**2 * speed) ** 0.6, rtol=1e-7)


@pytest.mark.promise("link-101")
def test_the_profile_on_a_mountain_lacks_what_lies_below():
    high = SlantPath(HufnagelValley(ground_m=2400.0), 0.5e-6, math.pi / 2.0, 500e3)
    assert high.fried_m > 1.05 * ZENITH.fried_m
    above = HufnagelValley(ground_m=2400.0).strength(1000.0) - 1.7e-14 * math.exp(-10.0)
    sea = HufnagelValley(ground_strength=0.0).strength(3400.0)
    assert above == pytest.approx(float(sea), rel=1e-12)


@pytest.mark.promise("link-101")
def test_the_wind_of_the_profile_is_that_of_bufton_from_5_to_20_km():
    squared = quad(lambda h: (8.0 + 30.0 * math.exp(-(((h - 9400.0) / 4800.0) ** 2))) ** 2, 5e3, 20e3)[0]
    assert BuftonWind(ground_m_s=8.0).rms_m_s == pytest.approx(math.sqrt(squared / 15e3), rel=1e-9)
    assert float(WIND.speed_m_s(1000.0) - BuftonWind().speed_m_s(1000.0)) == pytest.approx(5.0)


# ------------------------------------------------------------------------------------ against the spectrum of the air
def of_spectrum(function):
    """8 pi^2 k^2 times the integral of 0.033 kappa^(-8/3) and a function of kappa, in the logarithm of kappa."""
    inner = quad(lambda t: math.exp(-5.0 / 3.0 * t) * function(math.exp(t)), -14.0, 12.0, limit=4000, epsrel=1e-7)[0]
    return 8.0 * math.pi**2 * LOW.wavenumber**2 * 0.033 * inner


@pytest.mark.promise("link-102")
@pytest.mark.parametrize("diameter", [0.05, 0.3])
def test_the_index_of_an_aperture_is_that_of_its_filter_on_the_spectrum(diameter):
    """Of one thin layer at 8 km: with the filter of a Gaussian aperture exactly, with a round one within 15 %."""
    layer = 8000.0

    def waves(kappa):
        return 1.0 - math.cos(layer * kappa**2 / LOW.wavenumber)

    closed = Downlink(LOW)._closed(np.array([diameter**2 / 16.0]), np.array([layer / LOW.wavenumber]))[0]
    soft = of_spectrum(lambda kappa: waves(kappa) * math.exp(-((kappa * diameter) ** 2) / 16.0))
    assert closed == pytest.approx(soft, rel=2e-4)
    hard = of_spectrum(lambda kappa: waves(kappa) * (2.0 * j1(kappa * diameter / 2.0) / (kappa * diameter / 2.0)) ** 2)
    assert closed == pytest.approx(hard, rel=0.15)


@pytest.mark.promise("link-102")
def test_a_point_has_the_rytov_variance_and_wide_apertures_average():
    light = Downlink(LOW)
    assert light.variance(0.0) == pytest.approx(LOW.rytov, rel=2e-3)  # 2.25 is 2.2533
    assert light.variance(0.0) > 1.5 * light.variance(0.1) > 10.0 * light.variance(0.8) > 0.0
    # far beyond the Fresnel length the index falls as D^(-7/3)
    assert light.variance(8.0) / light.variance(4.0) == pytest.approx(2.0 ** (-7.0 / 3.0), rel=1e-2)


@pytest.mark.promise("link-103")
@pytest.mark.parametrize("tilt", ["zernike", pytest.param("gradient", marks=pytest.mark.endurance)])
def test_the_angle_of_arrival_has_the_variance_of_its_filter_and_of_its_spectrum(tilt):
    diameter, light = 0.25, Downlink(LOW)

    def filtered(x):
        return (8.0 * jv(2, x) / x**2) ** 2 if tilt == "zernike" else (2.0 * j1(x) / x) ** 2

    # half of both axes: pi times 2 pi 0.033 kappa^(-2/3) filtered, over all layers
    whole = quad(lambda t: math.exp(t / 3.0) * filtered(math.exp(t)), -40.0, math.log(300.0), limit=2000)[0]
    wanted = 2.0 * math.pi**2 * 0.033 * (diameter / 2.0) ** (-1.0 / 3.0) * whole * over_height(lambda h, z: 1.0)
    assert light.arrival_rms_rad(diameter, tilt) ** 2 == pytest.approx(wanted, rel=0.02)
    freq = np.geomspace(1e-3, 3e4, 600)
    psd = light.arrival_psd_rad2_hz(freq, diameter, WIND, tilt)
    below = 3.0 * freq[0] * psd[0]  # f^(-2/3) down to 0
    found = np.trapezoid(psd * freq, np.log(freq)) + below
    assert found == pytest.approx(wanted, rel=0.01)
    slope = np.diff(np.log(psd)) / np.diff(np.log(freq))
    assert slope[0] == pytest.approx(-2.0 / 3.0, abs=0.01)
    assert slope[-20:].mean() == pytest.approx(-17.0 / 3.0 if tilt == "zernike" else -11.0 / 3.0, abs=0.1)


# -------------------------------------------------------------------------------------------------------- the uplink
@pytest.mark.promise("link-104")
def test_the_index_of_a_beam_is_that_of_its_integral_over_the_spectrum():
    """One thin layer at 10 km, on the axis and off it."""
    up, layer = Uplink(LOW, 0.03), 10e3
    k, length = LOW.wavenumber, LOW.range_m
    far = 2.0 * length / (k * 0.03**2)
    theta, width, xi = 1.0 / (1.0 + far**2), far / (1.0 + far**2), 1.0 - layer / length
    a, b = width * length * xi**2 / k, length * xi * (1.0 - (1.0 - theta) * xi) / k
    closed = up._closed(np.array([a]), np.array([b]))[0]
    assert closed == pytest.approx(of_spectrum(lambda q: math.exp(-a * q**2) * (1.0 - math.cos(b * q**2))), rel=1e-3)
    assert up.variance(0.5) > up.variance() > 0.0
    spherical = Uplink(LOW, 1e-3)  # so small that it is a point
    assert spherical.variance() == pytest.approx(LOW.spherical_rytov, rel=1e-2)
    of_axis = up.variance(0.4) - up.variance()
    r = 0.4 * up.radius_m
    from scipy.special import i0

    def more(h, z):
        left = 1.0 - z / length
        damping, turn = width * length * left**2 / k, 2.0 * width * r * left
        return of_spectrum(lambda q: math.exp(-damping * q**2) * (i0(min(turn * q, 700.0)) - 1.0) if q < 300.0 else 0.0)

    height = np.array([20.0, 8000.0])
    each = [more(h, h / math.sin(LOW.elevation_rad)) for h in height]
    assert each[0] == pytest.approx(each[1], rel=0.03)  # nearly the same from all of the air
    assert of_axis == pytest.approx(each[0] * over_height(lambda h, z: 1.0), rel=0.03)


@pytest.mark.promise("link-104")
def test_wander_has_the_constant_that_is_asked_for():
    up = Uplink(LOW, 0.03)
    radius = lambda z: 0.03 * math.hypot(1.0, 2.0 * z / (LOW.wavenumber * 0.03**2))  # noqa: E731
    wanted = over_height(lambda h, z: (1.0 - z / 900e3) ** 2 * radius(z) ** (-1 / 3))
    assert up.wander_rms_rad("dios-2004") ** 2 == pytest.approx(2.07 * wanted, rel=1e-7)
    assert up.wander_rms_rad("itu-r-p1622") ** 2 == pytest.approx(3.4339 * wanted, rel=1e-4)
    assert up.wander_rms_rad("andrews-phillips-2005") ** 2 == pytest.approx(7.25 * wanted, rel=1e-7)
    known = "dios-2004, itu-r-p1622, andrews-phillips-2005"
    with pytest.raises(ValueError, match=f'the convention "dios" is none of {known}'):
        up.wander_rms_rad("dios")


@pytest.mark.promise("link-104")
def test_the_spread_and_the_point_ahead_of_an_uplink():
    up = Uplink(LOW, 0.03)
    assert up.radius_m == pytest.approx(1.55e-6 * 900e3 / (math.pi * 0.03), rel=1e-4)
    widened = 1.0 + (math.sqrt(8.0) * 0.03 / LOW.fried_m) ** (5.0 / 3.0)
    assert up.spread_db == pytest.approx(10.0 * math.log10(widened**1.2), rel=1e-12)
    assert up.anisoplanatic_rad2(LOW.isoplanatic_rad) == pytest.approx(1.0, rel=1e-12)
    assert up.anisoplanatic_rad2(50e-6) == pytest.approx((50e-6 / LOW.isoplanatic_rad) ** (5 / 3), rel=1e-12)


# ------------------------------------------------------------------------------------------------------------- fades
@pytest.mark.promise("link-105")
@pytest.mark.parametrize(
    "fades", [GammaGamma(0.8, 0.5), GammaGamma(4.2, 1.4), GammaGamma(1.4, 4.2), GammaGamma(40, 30)]
)
def test_gamma_gamma_fades_are_those_of_drawn_powers(fades):
    rng, count = np.random.default_rng(4), 400_000
    power = rng.gamma(fades.large, 1.0 / fades.large, count) * rng.gamma(fades.small, 1.0 / fades.small, count)
    assert np.var(power) == pytest.approx(fades.index, rel=0.05)
    for at in (0.02, 0.2, 0.7, 1.6):
        share = np.mean(power < at)
        assert float(fades.below(at)) == pytest.approx(share, abs=5.0 * math.sqrt(share / count) + 1e-6)
    for outage in (0.3, 1e-2):
        assert 10.0 ** (-0.1 * fades.loss_db(outage)) == pytest.approx(np.quantile(power, outage), rel=0.03)
    assert float(fades.below(10.0 ** (-0.1 * fades.loss_db(1e-6)))) == pytest.approx(1e-6, rel=1e-6)


@pytest.mark.promise("link-105")
def test_in_weak_turbulence_both_laws_agree_and_the_rytov_variance_is_the_index():
    weak = GammaGamma.of_plane_wave(0.02)
    assert weak.index == pytest.approx(0.02, rel=0.03)
    assert weak.loss_db(1e-2) == pytest.approx(LogNormal(weak.index).loss_db(1e-2), rel=0.05)
    assert GammaGamma.of_plane_wave(3.0).index == pytest.approx(1.2, abs=0.15)  # past the focus it falls towards 1
    assert GammaGamma.of_plane_wave(400.0).index < GammaGamma.of_plane_wave(8.0).index
    assert Downlink(LOW).at_point == GammaGamma.of_plane_wave(LOW.rytov)


@pytest.mark.promise("link-105")
def test_log_normal_fades_have_their_index():
    fades, rng = LogNormal(0.2), np.random.default_rng(2)
    variance = math.log(1.2)
    power = np.exp(math.sqrt(variance) * rng.standard_normal(400_000) - variance / 2.0)
    assert np.mean(power) == pytest.approx(1.0, abs=0.005) and np.var(power) == pytest.approx(0.2, rel=0.03)
    assert float(fades.below(0.5)) == pytest.approx(np.mean(power < 0.5), rel=0.05)
    assert fades.loss_db(0.01) == pytest.approx(-10.0 * math.log10(np.quantile(power, 0.01)), abs=0.05)
    assert LogNormal(0.0).loss_db(0.01) == 0.0


# ------------------------------------------------------------------------------------------------- regimes, refusals
@pytest.mark.promise("link-106")
def test_a_path_says_where_the_closed_forms_end():
    assert ZENITH.regimes == ()
    low = SlantPath(HufnagelValley(), 0.5e-6, math.radians(10.0), 1e6)
    strong, flat = low.regimes
    assert strong.startswith("strong turbulence: the Rytov variance is 5.8")
    assert flat.startswith("an elevation of 10 deg: below 20 deg the air is not flat")
    moderate = SlantPath(HufnagelValley(), 0.8e-6, math.radians(35.0), 1e6)
    assert moderate.regimes[0].startswith("moderate turbulence: the Rytov variance is 0.376")


@pytest.mark.promise("link-106")
@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda: SlantPath(HufnagelValley(), 1e-6, math.radians(3.0), 1e6), "lower air is not flat"),
        (lambda: SlantPath(HufnagelValley(), 1.55, math.pi / 2.0, 1e6), "SlantPath.wavelength_m"),
        (lambda: HufnagelValley(ground_strength=-1e-14), "HufnagelValley.ground_strength"),
        (lambda: BuftonWind(width_m=0.0), "BuftonWind.width_m"),
        (lambda: Uplink(LOW, 0.0), "Uplink.waist_m"),
        (lambda: Downlink(LOW).index(-0.1), "the aperture is -100 mm"),
        (lambda: Downlink(LOW).arrival_rms_rad(0.2, "best"), 'the tilt "best" is none of zernike, gradient'),
        (lambda: Downlink(LOW).arrival_psd_rad2_hz([0.0], 0.2, WIND), "the frequency is 0"),
        (lambda: Downlink(LOW).arrival_psd_rad2_hz([1.0], 0.2, BuftonWind(0.0, 0.0)), "air at rest has no spectrum"),
        (lambda: Uplink(LOW, 0.03).variance(-1.0), "the distance off the axis is -1"),
        (lambda: Uplink(LOW, 0.03).anisoplanatic_rad2(-1e-6), "the point-ahead angle is -1 µrad"),
        (lambda: GammaGamma(0.0, 1.0), "GammaGamma.large"),
        (lambda: GammaGamma.of_plane_wave(0.0), "the Rytov variance is 0"),
        (lambda: LogNormal(0.1).loss_db(1.0), "the outage is 1"),
        (lambda: GammaGamma(2.0, 1.0).loss_db(0.0), "the outage is 0"),
    ],
)
def test_what_cannot_be_is_refused(call, said):
    with pytest.raises(ValueError, match=said.replace("(", r"\(")):
        call()


UNLIKE_AIR = SlantPath(HufnagelValley(ground_strength=3.3e-15, wind_rms_m_s=16.0, ground_m=830.0), 1.31e-6, 0.71, 1.3e6)
UNLIKE_WIND = BuftonWind(ground_m_s=3.7, jet_m_s=27.0, peak_m=8.6e3, width_m=4.1e3, slew_rad_s=1.3e-3)
UNLIKE_FADES = {
    "log-normal": LogNormal(0.37),
    "gamma-gamma": GammaGamma(4.3, 2.7),
    "wandering": Wandering(GammaGamma(4.3, 2.7), 3.1),
}


@pytest.mark.parametrize(("found", "expected"), [
    (lambda: UNLIKE_AIR.profile.strength(np.array([0.0, 100.0, 3e3, 11e3])),
     [3.45525806e-15, 1.35924716e-15, 2.13194596e-17, 8.25679443e-18]),
    (lambda: [UNLIKE_AIR.fried_m, UNLIKE_AIR.isoplanatic_rad, UNLIKE_AIR.rytov,
            UNLIKE_AIR.spherical_rytov, UNLIKE_AIR.greenwood_hz(UNLIKE_WIND)],
     [0.25849845, 1.63494088e-05, 0.0846778895, 0.0840466689, 20.0622284]),
    (lambda: [*UNLIKE_WIND.speed_m_s(np.array([0.0, 5e3, 8.6e3, 2e4])), UNLIKE_WIND.rms_m_s],
     [4.03156707, 22.6892366, 41.88, 29.7118518, 32.1757363]),
    (lambda: [(down := Downlink(UNLIKE_AIR)).index(0.23), down.index(0.0), down.arrival_rms_rad(0.23,
            "gradient"), down.arrival_rms_rad(0.23, "zernike")],
     [0.0137316162, 0.0842600998, 2.1303674e-06, 2.20228803e-06]),
    (lambda: Downlink(UNLIKE_AIR).arrival_psd_rad2_hz(np.array([0.3, 7.0, 120.0]), 0.23, UNLIKE_WIND,
            "gradient"),
     [1.79385041e-12, 9.14432065e-14, 1.17356785e-16]),
    (lambda: [(up := Uplink(UNLIKE_AIR, 0.043)).index(), up.spread_db, up.radius_m,
            up.wander_rms_rad("dios-2004"), up.wander_rms_rad("itu-r-p1622"),
            up.anisoplanatic_rad2(31e-6)],
     [0.0333139956, 1.30527957, 12.6066253, 2.33180128e-06, 3.00329528e-06, 2.90468741]),
    (lambda: [x for each in UNLIKE_FADES.values() for x in each.below([0.1, 0.6, 1.9])],
     [
        6.58374413e-05, 0.264382352, 0.922849321, 0.0175470639, 0.381859297, 0.88162052, 0.0254784876,
        0.404972018, 0.875084507,
    ]),
    (lambda: [x for each in UNLIKE_FADES.values() for x in (each.loss_db(0.003), each.loss_db(0.7))],
     [7.37922994, -0.594224542, 13.3668452, -0.689419285, 14.4221862, -0.655269772]),
    (lambda: [(g := GammaGamma.of_plane_wave(1.7)).large, g.small, g.index,
            GammaGamma.of_index(0.9).large, GammaGamma.of_index(0.9).small],
     [4.00938237, 1.8485284, 0.925312069, 2.7057312, 2.58210663]),
    (lambda: [seeing.residual(n) for n in (0, 1, 3, 7, 33)], [1.0299, 1.0299, 0.134, 0.0587, 0.0142516831]),
    (lambda: [seeing.encircled(7e-6, 0.31, 1.31e-6, 0.12, tilt_taken_out=False), seeing.encircled(7e-6,
            0.31, 1.31e-6, 0.12, tilt_taken_out=True)],
     [0.493305251, 0.680340572]),
])  # fmt: skip
def test_air_of_numbers_unlike_each_other(found, expected):
    assert list(found()) == pytest.approx(expected, rel=1e-6, abs=0.0, nan_ok=True)


NEAR_AIR = SlantPath(HufnagelValley(2.1e-14, 18.0), 5.3e-7, 0.94, 2.4e5)
STRONG_AIR = SlantPath(HufnagelValley(6e-13, 45.0, 120.0), 5.3e-7, 0.13, 2.9e6)


@pytest.mark.parametrize(("found", "expected"), [
    (lambda: [Uplink(NEAR_AIR, waist).index() for waist in (0.2, 0.6, 2.5)], "1.35284129 1.20650397 1.18858776"),
    (lambda: [Uplink(NEAR_AIR, 0.6).variance(off) for off in (0.0, 0.4, 1.7)], "28.3018393 34.8770448 241.780651"),
    (lambda: [(up := Uplink(NEAR_AIR, 0.6)).spread_db, up.radius_m, up.wander_rms_rad("andrews-phillips-2005")],
     "31.9901653 0.603782891 5.24233247e-06"),
    (lambda: [NEAR_AIR.spherical_rytov, NEAR_AIR.rytov, NEAR_AIR.moment(2.0), NEAR_AIR.moment(-0.5)],
     "0.279657569 0.287665364 2.75518228e-05 4.31267738e-13"),
    (lambda: Downlink(UNLIKE_AIR).arrival_psd_rad2_hz([[4e-7, 2e-6], [900.0, 5e4]], 0.23, UNLIKE_WIND).ravel(),
     "1.59326192e-08 5.44887912e-09 2.1708161e-21 2.47805734e-31"),
    (lambda: Downlink(UNLIKE_AIR).arrival_psd_rad2_hz([3e-7, 700.0, 4e4], 0.31, UNLIKE_WIND, "gradient"),
     "1.930027e-08 4.73656903e-20 1.81163721e-26"),
    (lambda: Downlink(UNLIKE_AIR).arrival_psd_rad2_hz(11.0, 0.31, UNLIKE_WIND).reshape(1), "3.33305348e-14"),
    (lambda: [Downlink(NEAR_AIR).index(d) for d in (0.0, 0.04, 0.7, 6.0)],
     "0.270092831 0.143076355 0.000971843041 6.46445856e-06"),
    (lambda: [Downlink(STRONG_AIR).index(d) for d in (0.0, 0.04, 0.7)], "1.15592041 1.19606861 0.811109491"),
    (lambda: [STRONG_AIR.rytov, Uplink(STRONG_AIR, 0.02).index(), Downlink(STRONG_AIR).at_point.large],
     "70.7735321 1.52066983 12.2525132"),
    (lambda: [Uplink(UNLIKE_AIR, 0.043).anisoplanatic_rad2(x) for x in (0.0, 3e-6)], "0 0.0592514073"),
    (lambda: HufnagelValley(0.0, 0.0, 0.0).strength([0.0, 1500.0, -200.0]), "2.7e-16 9.93274491e-17 2.7e-16"),
    (lambda: HufnagelValley(ground_m=-400.0).strength([0.0, 350.0, 500.0]), "1.727e-14 7.83355518e-16 3.67131985e-16"),
    (lambda: HufnagelValley().strength([[20.0], [9e3]]).ravel(), "1.41848467e-14 1.61314979e-17"),
    (lambda: [(w := BuftonWind()).rms_m_s, *w.speed_m_s([0.0, 9.4e3, 1.42e4])], "22.9636908 5.64799515 35 16.0363832"),
    (lambda: BuftonWind(0.0, 0.0, slew_rad_s=2e-3).speed_m_s([0.0, 1e3]), "0 2"),
    (lambda: [GammaGamma(2.7, 4.3).below(p) - GammaGamma(4.3, 2.7).below(p) for p in (0.01, 1.0)], "0 0"),
    (lambda: GammaGamma(90.0, 55.0).below([0.0, 0.3, 0.7, 1.0, 1.6, 40.0]),
     "0 1.75027463e-10 0.0256971138 0.528095868 0.998318814 1"),
    (lambda: GammaGamma(0.6, 1.1).below([1e-40, 1e-6, 0.02, 3.0, 90.0]),
     "1.60742737e-24 0.000407824914 0.137383588 0.915049248 0.999999619"),
    (lambda: [GammaGamma(0.6, 1.1).loss_db(p) for p in (1e-12, 0.04, 0.97)], "203.51431 26.5118544 -7.62138881"),
    (lambda: [GammaGamma(90.0, 55.0).loss_db(p) for p in (1e-12, 0.04, 0.97)], "5.93283241 1.39315295 -1.3108885"),
    (lambda: LogNormal(0.0).below([0.99, 1.01]), "0 1"),
    (lambda: [*LogNormal(2.3).below([0.0, 0.2, 5.0]), LogNormal(2.3).loss_db(0.5), LogNormal(0.0).loss_db(0.01)],
     "0 0.17706454 0.97827081 2.5925697 0"),
    (lambda: Wandering(LogNormal(0.09), 0.7).below([[0.0, 1e-3], [0.5, 2.2]]).ravel(),
     "0 0.00449286272 0.348178659 0.909705629"),
    (lambda: [Wandering(LogNormal(0.09), 0.7).loss_db(p) for p in (1e-6, 0.3)], "82.1789021 3.93431278"),
    (lambda: [seeing.residual(n) for n in (2, 4, 6, 8, 9, 10, 11, 12, 13, 14)],
     "0.582 0.111 0.0648 0.0525 0.0463 0.0401 0.0377 0.0352 0.0319326208 0.0299475853"),
    (lambda: [seeing.encircled(2e-6, 1.3, 8.1e-7, r0) for r0 in (0.07, 0.4, math.inf)],
     "0.0682527361 0.755084771 0.937644526"),
    (lambda: [seeing.encircled(6e-5, 0.07, 8.1e-7, 0.02, tilt_taken_out=tilt) for tilt in (False, True)],
     "0.890644354 0.907265083"),
])  # fmt: skip
def test_air_at_its_edges_has_these_numbers(found, expected):
    assert list(found()) == pytest.approx([float(each) for each in expected.split()], rel=1e-6, abs=0.0, nan_ok=True)


@pytest.mark.parametrize(("found", "expected"), [
    (lambda: "; ".join(UNLIKE_AIR.regimes), ""),
    (lambda: "; ".join(STRONG_AIR.regimes),
     "strong turbulence: the Rytov variance is 70.8, above 0.3; an index is that for any strength (Andrews and "
     "Phillips), but spread and wander are those of weak turbulence; an elevation of 7.45 deg: below 20 deg the "
     "air is not flat, and refraction bends the path"),
    (lambda: "; ".join(replace(UNLIKE_AIR, elevation_rad=math.radians(17.26)).regimes),
     "moderate turbulence: the Rytov variance is 0.358, above 0.3; an index is that for any strength (Andrews "
     "and Phillips), but spread and wander are those of weak turbulence; an elevation of 17.3 deg: below 20 deg "
     "the air is not flat, and refraction bends the path"),
    (lambda: "; ".join(replace(NEAR_AIR, elevation_rad=math.radians(20.0), wavelength_m=9e-7).regimes),
     "moderate turbulence: the Rytov variance is 0.749, above 0.3; an index is that for any strength (Andrews "
     "and Phillips), but spread and wander are those of weak turbulence"),
    (lambda: "; ".join(replace(NEAR_AIR, elevation_rad=0.6).regimes),
     "moderate turbulence: the Rytov variance is 0.554, above 0.3; an index is that for any strength (Andrews "
     "and Phillips), but spread and wander are those of weak turbulence"),
])  # fmt: skip
def test_air_beyond_its_closed_forms_is_said_in_words(found, expected):
    assert found() == expected


@pytest.mark.parametrize(("found", "expected"), [
    (lambda: Downlink(UNLIKE_AIR).arrival_rms_rad(0.0), "the aperture is 0 m: it must be finite, above 0 m"),
    (lambda: Downlink(UNLIKE_AIR).arrival_psd_rad2_hz([1.0], -0.2, UNLIKE_WIND),
     "the aperture is -200 mm: it must be finite, above 0 m"),
    (lambda: Downlink(UNLIKE_AIR).arrival_psd_rad2_hz([1.0], 0.2, UNLIKE_WIND, "slope"),
     'the tilt "slope" is none of zernike, gradient'),
    (lambda: Downlink(UNLIKE_AIR).variance(-0.2), "the aperture is -200 mm: it must be finite, at least 0 m"),
    (lambda: Downlink(UNLIKE_AIR).arrival_psd_rad2_hz([1.0], 0.2, BuftonWind(0.0, 0.0)),
     "the slowest wind is 0 m/s: it must be finite, above 0 m/s; air at rest has no spectrum"),
    (lambda: Uplink(UNLIKE_AIR, 0.03).wander_rms_rad("dios"),
     'the convention "dios" is none of dios-2004, itu-r-p1622, andrews-phillips-2005'),
    (lambda: Uplink(UNLIKE_AIR, 0.0), "Uplink.waist_m is 0 m: it must be finite, above 0 m, at most 100 m"),
    (lambda: Uplink(UNLIKE_AIR, 101.0), "Uplink.waist_m is 101 m: it must be finite, above 0 m, at most 100 m"),
    (lambda: replace(UNLIKE_AIR, elevation_rad=math.radians(4.9)),
     "SlantPath.elevation_rad is 85.52 mrad: it must be finite, at least 87.27 mrad, at most 1.571 rad; lower "
     "air is not flat"),
    (lambda: replace(UNLIKE_AIR, range_m=9e4),
     "SlantPath.range_m is 90 km: it must be finite, at least 100 km, at most 1000000000 km"),
    (lambda: replace(UNLIKE_AIR, wavelength_m=9e-8),
     "SlantPath.wavelength_m is 90 nm: it must be finite, at least 100 nm, at most 100 µm"),
    (lambda: HufnagelValley(ground_m=9001.0),
     "HufnagelValley.ground_m is 9.001 km: it must be finite, at least -500 m, at most 9 km"),
    (lambda: HufnagelValley(wind_rms_m_s=200.5),
     "HufnagelValley.wind_rms_m_s is 200.5 m/s: it must be finite, at least 0 m/s, at most 200 m/s"),
    (lambda: HufnagelValley(-1e-14), "HufnagelValley.ground_strength is -1e-14: it must be finite, at least 0"),
    (lambda: BuftonWind(width_m=0.0), "BuftonWind.width_m is 0 m: it must be finite, above 0 m, at most 30 km"),
    (lambda: BuftonWind(peak_m=3.1e4), "BuftonWind.peak_m is 31 km: it must be finite, at least 0 m, at most 30 km"),
    (lambda: BuftonWind(slew_rad_s=-0.1),
     "BuftonWind.slew_rad_s is -100 mrad/s: it must be finite, at least 0 rad/s, at most 1 rad/s"),
    (lambda: GammaGamma.of_index(0.0), "the scintillation index is 0: it must be finite, above 0"),
    (lambda: Wandering(LogNormal(0.1), 0.0), "Wandering.beam is 0: it must be finite, above 0"),
    (lambda: LogNormal(-0.1), "LogNormal.index is -0.1: it must be finite, at least 0"),
    (lambda: LogNormal(0.2).loss_db(0.0), "the outage is 0: it must be finite, above 0 and below 1"),
    (lambda: Wandering(LogNormal(0.2), 1.0).loss_db(1.0), "the outage is 1: it must be finite, above 0 and below 1"),
])  # fmt: skip
def test_a_refusal_of_air_says_its_numbers_and_bounds(found, expected):
    with pytest.raises((ValueError, ArithmeticError)) as refused:
        found()
    assert str(refused.value) == expected


def test_air_beyond_the_satellite_does_not_count():
    near = SlantPath(HufnagelValley(2.1e-14, 18.0), 5.3e-7, 0.94, 1.2e5)
    _, distance, strength = SlantPath(near.profile, near.wavelength_m, near.elevation_rad, 1e6).layers()
    there = distance < near.range_m
    assert 0 < np.count_nonzero(there) < there.size
    left, k = 1.0 - distance[there] / near.range_m, near.wavenumber
    expected = 2.25 * k ** (7 / 6) * strength[there] @ (distance[there] * left) ** (5 / 6)
    assert near.spherical_rytov == pytest.approx(expected, rel=1e-12)
    assert near.moment(2.0) == pytest.approx(strength[there] @ distance[there] ** 2, rel=1e-12)
    up = Uplink(near, 0.6)
    radius = 0.6 * np.hypot(1.0, 2.0 * distance[there] / (k * 0.6**2))
    wander = 2.07 * strength[there] @ (left**2 * radius ** (-1 / 3))
    assert up.wander_rms_rad("dios-2004") == pytest.approx(math.sqrt(wander), rel=1e-12)
