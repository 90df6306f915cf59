"""Time, Earth, Sun, analytic orbits and stations against astropy, skyfield, integration and ray tracing."""

import dataclasses
import itertools
import math
import socket
import subprocess
import sys
from datetime import datetime

import erfa
import numpy as np
import pytest
from astropy import units
from astropy.coordinates import EarthLocation, get_sun
from astropy.time import Time
from astropy.utils import iers
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from microrad.core.earth import EARTH_RADIUS_M, GEOSTATIONARY_RADIUS_M, MU_M3_S2, ROTATION_RAD_S, place_m
from microrad.core.units import SPEED_OF_LIGHT_M_S
from microrad.orbit.base import OrbitError
from microrad.orbit.earth import epoch, sun
from microrad.orbit.earth import figure as earth
from microrad.orbit.earth.epoch import Epoch
from microrad.orbit.propagation import analytic

START = Epoch("2026-03-20T12:00:00Z")
DAY_S = 86400.0
MINUTE_S = 60.0
RE = EARTH_RADIUS_M
SPHERE, OBLATE = earth.Earth("sphere", 0.0), earth.Earth("oblate", 0.0)
LEO = analytic.circular("LEO", START, 500e3, 0.0, 0.3, 1.2, False)
SLOT = analytic.GeostationarySlot("GEO", START, 0.4)

half_a_hundredth_minute = 0.005
one_millimetre = 1e-3
ten_micrometres = 1e-5
one_microradian = 1e-6
rounding_rad = 4e-15

quick = settings(deadline=None, max_examples=60, derandomize=True)


@pytest.fixture(autouse=True)
def no_download():
    with iers.conf.set_temp("auto_download", False), iers.conf.set_temp("iers_degraded_accuracy", "warn"):
        yield


def random(key):
    return np.random.Generator(np.random.Philox(key=key))


def directions(key, n):
    v = random(key).normal(size=(3, n))
    return v / np.linalg.norm(v, axis=0)


def length(v):
    return np.linalg.norm(v, axis=0)


def wrapped(angle):
    return (np.asarray(angle) + math.pi) % (2.0 * math.pi) - math.pi


# ---- time
@pytest.mark.parametrize(
    ("text", "normal"),
    [
        ("2026-03-20T12:00:00Z", "2026-03-20T12:00:00Z"),
        ("2026-03-20T12:00Z", "2026-03-20T12:00:00Z"),
        ("2026-03-20 12:00:00.2500+00:00", "2026-03-20T12:00:00.25Z"),
        ("2026-03-20T12:00:30.000Z", "2026-03-20T12:00:30Z"),
        ("2016-12-31T23:59:60.5Z", "2016-12-31T23:59:60.5Z"),
        ("2026-03-20T23:59:59.5+0000", "2026-03-20T23:59:59.5Z"),
        ("1973-01-02T00:00:00Z", "1973-01-02T00:00:00Z"),
        ("2050-12-31T23:59:59Z", "2050-12-31T23:59:59Z"),
    ],
)
def test_an_instant_is_brought_to_one_form(text, normal):
    epoch = Epoch(text)
    assert epoch.text == normal
    assert epoch == Epoch(normal)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("2026-03-20T12:00:00", "has no time zone"),
        ("2026-03-20T12:00:00-00:00", "has no time zone"),
        ("2026-03-20T12:00:00+01:00", "is not a date and time"),
        ("2026-03-20", "is not a date and time"),
        ("20.3.2026 12:00Z", "is not a date and time"),
        ("２０26-03-20T12:00:00Z", "is not a date and time"),
        (20260320, "is not a date and time"),
        ("2026-02-29T12:00:00Z", "names no day of the calendar"),
        ("2026-03-20T24:00:00Z", "names no time of the day"),
        ("2026-03-20T12:00:60Z", "names no time of the day"),
        ("2026-03-20T23:59:60Z", "none was inserted"),
        ("2016-12-31T23:59:61Z", "names no time of the day"),
        ("2026-03-20T12:60:00Z", "names no time of the day"),
        ("2016-12-31T23:58:60Z", "names no time of the day"),
        ("2016-12-31T22:59:60Z", "names no time of the day"),
        ("2026-03-20T12:00:00-0000", "has no time zone"),
        ("1973-01-01T23:59:59Z", "outside 1973-01-02 to 2050-12-31"),
        ("1972-06-01T00:00:00Z", "outside 1973-01-02 to 2050-12-31"),
        ("2051-01-01T00:00:00Z", "outside 1973-01-02 to 2050-12-31"),
    ],
)
def test_a_text_that_is_no_instant_is_refused_in_words(text, words):
    with pytest.raises(OrbitError, match=words) as refused:
        Epoch(text)
    assert repr(text) in str(refused.value)
    assert "2026-03-20T12:00:00Z" in str(refused.value) or "take an instant" in str(refused.value)


instants = st.datetimes(datetime(1973, 1, 3), datetime(2026, 12, 1)).map(lambda moment: moment.isoformat() + "Z")


@quick
@given(instants, instants)
def test_elapsed_seconds_and_julian_dates_are_those_of_astropy(one, other):
    first, second = Epoch(one), Epoch(other)
    a, b = (Time(e.text[:-1], format="isot", scale="utc") for e in (first, second))
    assert first.seconds_to(second) == pytest.approx((b.tai - a.tai).sec, abs=1e-5)
    assert first.seconds_to(second) == -second.seconds_to(first)
    whole, fraction = first.julian_date
    assert whole % 1.0 == 0.5
    assert ((whole - a.jd1) + (fraction - a.jd2)) * DAY_S == pytest.approx(0.0, abs=1.0)  # ERFA stretches leap days
    written = Epoch(first.utc(first.seconds_to(second)))
    assert written.seconds_to(second) == pytest.approx(0.0, abs=5.01e-4)  # half a millisecond


def test_seconds_through_a_leap_second_are_counted_and_written():
    before = Epoch("2016-12-31T23:59:59Z")
    assert before.seconds_to(Epoch("2016-12-31T23:59:60Z")) == 1.0
    assert before.seconds_to(Epoch("2017-01-01T00:00:00Z")) == 2.0
    written = [before.utc(s) for s in (0.0, 0.9994, 0.9996, 1.25, 1.9996, 2.0, -1.0)]
    seconds = ["59.000", "59.999", "60.000", "60.250"]
    assert written[:4] == [f"2016-12-31T23:59:{s}Z" for s in seconds]
    assert written[4:] == ["2017-01-01T00:00:00.000Z", "2017-01-01T00:00:00.000Z", "2016-12-31T23:59:58.000Z"]
    inside = Epoch("2016-12-31T23:59:60.5Z")
    assert inside.utc(0.5) == "2017-01-01T00:00:00.000Z"
    assert inside.utc(0.0) == "2016-12-31T23:59:60.500Z"


@pytest.mark.parametrize("time_s", [math.nan, math.inf])
def test_a_time_that_is_no_number_is_refused(time_s):
    with pytest.raises(OrbitError, match="is not a number"):
        START.earth_rotation_rad(np.array([0.0, time_s]))
    with pytest.raises(OrbitError, match="is not a number"):
        START.utc(time_s)


@pytest.mark.parametrize("time_s", [-60.0 * 365.0 * DAY_S, 30.0 * 365.0 * DAY_S])
def test_a_time_outside_the_tables_is_refused(time_s):
    with pytest.raises(OrbitError, match="outside 1973-01-02 to 2050-12-31"):
        START.earth_rotation_rad(np.array([0.0, time_s]))


@pytest.mark.promise("day-9")
@pytest.mark.parametrize("text", ["1975-02-03T04:05:06Z", "1998-12-31T20:00:00Z", "2016-12-31T23:00:00Z", START.text])
def test_the_earth_turns_as_in_astropy(text):
    """UT1 of astropy's newer table and skyfield's differ by some ms (predictions): 1 ms is 7e-8 rad."""
    time_s = np.linspace(0.0, 3.0 * DAY_S, 50)
    instants = Time(text[:-1], format="isot", scale="utc").tai + time_s * units.s
    wanted = instants.utc.sidereal_time("mean", "greenwich", model="IAU1982").rad
    angle = Epoch(text).earth_rotation_rad(time_s)
    assert np.max(np.abs(wrapped(angle - wanted))) < one_microradian
    np.testing.assert_allclose(np.diff(angle), ROTATION_RAD_S * np.diff(time_s), rtol=1e-6)


@pytest.mark.promise("day-9")
@pytest.mark.parametrize("text", ["1990-06-01T03:00:00Z", "2016-12-31T23:00:00Z", START.text, "2050-12-29T12:00:00Z"])
def test_the_earth_turns_as_in_skyfield(text):
    from skyfield.api import load
    from skyfield.sgp4lib import theta_GMST1982

    scale = load.timescale(builtin=True)
    epoch = Epoch(text)
    moment = scale.utc(*(int(text[a:b]) for a, b in ((0, 4), (5, 7), (8, 10), (11, 13))))
    time_s = np.linspace(0.0, 2.0 * DAY_S - 7200.0, 77)
    later = scale.tt_jd(moment.whole, moment.tt_fraction + time_s / DAY_S)
    wanted, _ = theta_GMST1982(later.whole, later.ut1_fraction)
    assert np.max(np.abs(wrapped(epoch.earth_rotation_rad(time_s) - wanted))) < 1e-10


def test_the_angle_at_a_time_does_not_hang_on_the_other_times():
    time_s = np.linspace(-3.0 * DAY_S, 40.0 * DAY_S, 301)
    together = START.earth_rotation_rad(time_s)
    alone = [float(START.earth_rotation_rad(t)) for t in time_s]
    assert together.tolist() == alone


def test_the_angle_is_the_same_seen_from_an_instant_decades_before():
    early, late = Epoch("1973-06-01T00:00:00Z"), Epoch("2049-03-04T05:06:07Z")
    apart = early.earth_rotation_rad(early.seconds_to(late)) - late.earth_rotation_rad(0.0)
    assert abs(float(wrapped(apart))) < 3.6e-11  # a float of 2.4e9 s is good to 4.8e-7 s, 3.5e-11 rad


@pytest.mark.promise("day-9")
def test_no_table_is_downloaded(monkeypatch):
    def asked(*args, **more):
        raise AssertionError("the network was asked for")

    monkeypatch.setattr(socket, "socket", asked)
    monkeypatch.setattr(socket, "getaddrinfo", asked)
    assert epoch._tables.__wrapped__().first_day == epoch._tables().first_day


def test_the_tables_of_time_are_read_only_when_an_instant_needs_them():
    code = (
        "import sys; from microrad.orbit.earth import sun; from microrad.orbit.earth.epoch import Epoch;"
        "from microrad.orbit.propagation import analytic;"
        "Epoch('2026-03-20T12:00:00Z'); assert 'skyfield' not in sys.modules and 'sgp4' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


# ---- Earth
def test_the_geostationary_radius_follows_from_the_sidereal_rotation():
    assert round(GEOSTATIONARY_RADIUS_M / 1e3, 2) == 42_164.17
    assert 2.0 * math.pi / ROTATION_RAD_S == pytest.approx(86164.0905, abs=1e-3)


@pytest.mark.parametrize("j2", [False, True])
def test_gravity_is_the_slope_of_its_potential(j2):
    def potential(r):
        square = np.sum(r * r, axis=0)
        flat = earth.J2 * RE**2 / square * (1.5 * r[2] ** 2 / square - 0.5) if j2 else 0.0
        return MU_M3_S2 / np.sqrt(square) * (1.0 - flat)

    r, step = 7.2e6 * directions(1, 30), 30.0
    slope = [(potential(r + step * e) - potential(r - step * e)) / (2.0 * step) for e in np.eye(3)[:, :, None]]
    np.testing.assert_allclose(earth.gravity(r, j2), slope, rtol=0.0, atol=1e-8)


def test_the_place_below_a_satellite_is_that_of_astropy():
    n = 400
    height = np.concatenate((np.full(100, 0.0), random(2).uniform(-1e3, 4e7, n - 100)))
    r = (RE * 0.999 + height) * directions(3, n)
    r[:, :4] = np.array([[0, 0, 7e6], [0, 0, -7e6], [7e6, 0, 0], [-7e6, 0, 0]]).T
    angle = random(4).uniform(-20.0, 600.0, n)
    angle[:4] = 0.0
    c, s = np.cos(angle), np.sin(angle)
    place = EarthLocation.from_geocentric(c * r[0] + s * r[1], c * r[1] - s * r[0], r[2], unit="m")
    below = earth.subpoint(r, angle)
    np.testing.assert_allclose(below.latitude_rad, place.lat.rad, rtol=0.0, atol=1e-10)  # astropy's is short of that
    back = EarthLocation.from_geodetic(place.lon, below.latitude_rad * units.rad, below.height_m * units.m).geocentric
    np.testing.assert_allclose(back[2].to_value("m"), r[2], rtol=0.0, atol=1e-7)
    np.testing.assert_allclose(wrapped(below.longitude_rad - place.lon.rad), 0.0, rtol=0.0, atol=1e-13)
    np.testing.assert_allclose(below.height_m, place.height.to_value("m"), rtol=0.0, atol=ten_micrometres)
    assert below.longitude_rad[3] == -math.pi
    assert np.all((below.longitude_rad >= -math.pi) & (below.longitude_rad < math.pi))


def walk(surface, first, second, steps=20001):
    """Least distance from the centre along the segment, in units of the raised semi-axes."""
    a, b = earth.semi_axes_m(surface.shape, surface.grazing_height_m)
    share = np.linspace(0.0, 1.0, steps)
    return np.min(length((first[:, None] * (1.0 - share) + second[:, None] * share) / np.array([[a], [a], [b]])))


SURFACES = (SPHERE, OBLATE, earth.Earth("sphere", 100e3), earth.Earth("oblate", 100e3))
each_surface = pytest.mark.parametrize(
    "surface", SURFACES, ids=lambda s: f"{s.shape} {s.grazing_height_m / 1e3:.0f} km"
)


@each_surface
def test_a_line_is_free_when_no_point_of_it_is_below_the_surface(surface):
    n = 300
    first = random(5).uniform(6.6e6, 9e6, n) * directions(6, n)
    second = random(7).uniform(6.6e6, 4.3e7, n) * directions(8, n)
    clearance = surface.clearance_rad(first, second)
    free = np.array([walk(surface, first[:, k], second[:, k]) > 1.0 + 1e-9 for k in range(n)])
    assert 50 < free.sum() < 250
    np.testing.assert_array_equal(clearance > 0.0, free)


@each_surface
def test_two_terminals_spread_by_their_clearance_see_the_surface_touched(surface):
    scale = np.array(earth.semi_axes_m(surface.shape, surface.grazing_height_m))[[0, 0, 1]]
    for key in range(12):
        first, second = (7e6 * directions(20 + key, 2) / scale[:, None]).T
        clearance = float(surface.clearance_rad((first * scale)[:, None], (second * scale)[:, None])[0])
        axis = np.cross(first, second)
        axis /= length(axis)
        c, s = math.cos(clearance), math.sin(clearance)
        spread = c * second + s * np.cross(axis, second)
        assert length(np.cross(first, spread)) / length(first - spread) == pytest.approx(1.0, abs=1e-12)


def test_a_terminal_a_millimetre_over_the_surface_sees_its_horizon():
    first = np.array([[RE + 1e-3], [0.0], [0.0]])
    away = 0.3
    second = 2.0 * RE * np.array([[math.cos(away)], [math.sin(away)], [0.0]])
    dip = math.sqrt(2e-3 / RE)
    wanted = dip + math.acos(0.5) - away
    assert SPHERE.clearance_rad(first, second)[0] == pytest.approx(wanted, abs=1e-11)


def test_the_oblate_earth_lets_more_through_over_the_poles_and_as_much_in_the_equator():
    r = RE + 500e3
    pole = np.array([[r * math.sin(0.37), 0.0, r * math.cos(0.37)], [-r * math.sin(0.37), 0.0, r * math.cos(0.37)]]).T
    equator = pole[[0, 2, 1]]
    gain = OBLATE.clearance_rad(*pole.T) - SPHERE.clearance_rad(*pole.T)
    assert 2e-3 < gain < 3e-2
    assert OBLATE.clearance_rad(*equator.T) == SPHERE.clearance_rad(*equator.T)


@pytest.mark.parametrize("height_m", [20e3, 100e3])
def test_the_raised_ellipsoid_is_the_surface_of_that_height_to_a_few_millionths(height_m):
    latitude = np.linspace(-math.pi / 2, math.pi / 2, 2001)
    a, b = earth.semi_axes_m("oblate", height_m)
    z = b * np.sin(latitude)
    r = np.stack((a * np.cos(latitude), 0.0 * z, z))
    short = height_m - earth.subpoint(r, np.zeros_like(z)).height_m
    assert -ten_micrometres < short.min()
    assert 1.2e-6 * height_m < short.max() < 1.45e-6 * height_m


coordinate = st.floats(-5e7, 5e7, allow_subnormal=False)
place = st.tuples(coordinate, coordinate, coordinate).filter(lambda r: math.dist(r, (0, 0, 0)) > 6.6e6)


@quick
@given(st.sampled_from(SURFACES), st.lists(st.tuples(place, place), min_size=1, max_size=9))
def test_clearance_is_the_same_to_the_last_bit_when_the_terminals_are_swapped(surface, pairs):
    first, second = np.array(pairs, dtype=float).transpose(1, 2, 0)
    one, other = surface.clearance_rad(first, second), surface.clearance_rad(second, first)
    assert one.tobytes() == other.tobytes()


@each_surface
def test_swapping_changes_no_bit_of_a_hundred_thousand_clearances(surface):
    first, second = (random(k).uniform(7e6, 4e7, 100_000) * directions(k + 1, 100_000) for k in (40, 42))
    one, other = surface.clearance_rad(first, second), surface.clearance_rad(second, first)
    assert one.tobytes() == other.tobytes()


def test_a_terminal_below_the_surface_is_refused_with_its_depth():
    r = np.array([[RE + 200e3, RE + 60e3], [0.0, 0.0], [0.0, 0.0]])
    with pytest.raises(OrbitError, match=r"the second terminal \(sample 1\) is 39\.\d+ km below .* lower the grazing"):
        earth.Earth("oblate", 100e3).clearance_rad(r + 5e5, r)
    with pytest.raises(OrbitError, match="the first terminal"):
        SPHERE.clearance_rad(np.array([[math.nan], [0.0], [0.0]]), r[:, :1])


def test_a_terminal_on_the_surface_itself_is_over_it():
    on, over = np.array([[RE], [0.0], [0.0]]), np.array([[2.0 * RE], [0.0], [0.0]])
    assert SPHERE.clearance_rad(on, over)[0] == pytest.approx(math.pi / 3.0)
    assert SPHERE.clearance_rad(over, on)[0] == pytest.approx(math.pi / 3.0)


def test_a_surface_that_is_none_is_refused():
    with pytest.raises(OrbitError, match="'flat' is not known; write oblate or sphere"):
        earth.Earth("flat", 0.0)
    for height in (-1.0, 2e6, math.nan):
        with pytest.raises(OrbitError, match=r"Earth\.grazing_height_m is .* finite, at least 0 m, at most 1000 km"):
            earth.Earth("sphere", height)


# ---- Sun
def teme_matrix(tt):
    """Rotation from GCRS to TEME: IAU 1976/1980 precession and nutation, less the equation of the equinoxes."""
    return erfa.rz(-erfa.eqeq94(tt.jd1, tt.jd2), erfa.pnm80(tt.jd1, tt.jd2))


@pytest.mark.parametrize("year", range(2020, 2041, 4))
def test_the_sun_stands_where_astropy_has_it(year):
    epoch = Epoch(f"{year}-01-05T06:00:00Z")
    time_s = np.linspace(0.0, 366.0 * DAY_S, 100)
    centuries = epoch.terrestrial_centuries(time_s)
    tt = Time(2451545.0, centuries * 36525.0, format="jd", scale="tdb")  # 2 ms from TT at most
    wanted = get_sun(tt).cartesian.xyz.to_value("AU")
    wanted = np.einsum("nij,jn->in", teme_matrix(tt), wanted / length(wanted))
    found = sun.sun_direction(epoch, time_s)
    np.testing.assert_allclose(length(found), 1.0, rtol=1e-14)
    off = np.degrees(length(found - wanted))
    assert off.max() < 0.02
    assert off.max() > 0.001  # a low-precision formula; less would mean that both sides are one


def test_terrestrial_time_is_that_of_astropy():
    tt = Time("2026-03-20T12:00:00", scale="utc").tt
    wanted = ((tt.jd1 - 2451545.0) + tt.jd2) / 36525.0
    assert float(START.terrestrial_centuries(0.0)) == pytest.approx(wanted, abs=1e-15)


def whole_disc_hidden(r, to_sun, shape, points=1440):
    """Whether the rays from a satellite to points on the rim of the Sun's disc all meet the Earth."""
    a, b = earth.semi_axes_m(shape)
    scale = np.array([a, a, b])
    distance = length(to_sun)
    towards = to_sun / distance
    u = np.cross(towards, [0.3, -0.5, 0.8])
    u /= length(u)
    v = np.cross(towards, u)
    rim = math.asin(sun.SUN_RADIUS_M / distance)
    turn = np.linspace(0.0, 2.0 * math.pi, points, endpoint=False)[:, None]
    ray = math.cos(rim) * towards + math.sin(rim) * (np.cos(turn) * u + np.sin(turn) * v)
    p, d = r / scale, ray / scale
    half, square = d @ p, np.sum(d * d, axis=1)
    return bool(np.all((half**2 >= square * (p @ p - 1.0)) & (half < 0.0)))


@pytest.mark.promise("day-17")
@pytest.mark.parametrize(("shape", "doubt_rad"), [("sphere", 1e-7), ("oblate", 1.8e-5)])
@pytest.mark.parametrize("altitude_m", [400e3, 2000e3, 35.8e6])
def test_night_is_when_the_whole_disc_of_the_sun_is_behind_the_earth(shape, doubt_rad, altitude_m):
    for key in range(20):
        light = sun.sun_direction(START, random(key).uniform(0.0, 365.0 * DAY_S))
        side = np.cross(light, directions(100 + key, 1)[:, 0])
        side /= length(side)

        def at(angle, light=light, side=side):
            return (RE + altitude_m) * (-math.cos(angle) * light + math.sin(angle) * side)

        def depth(angle, light=light, at=at):
            return float(sun.shadow_rad(at(angle)[:, None], light[:, None], shape)[0])

        limit = brentq(depth, 1e-4, math.pi / 2, xtol=1e-13)
        for angle, hidden in ((limit - doubt_rad, True), (limit + doubt_rad, False)):
            assert (depth(angle) > 0.0) is hidden
            to_sun = sun.ASTRONOMICAL_UNIT_M * light - at(angle)
            assert whole_disc_hidden(at(angle), to_sun, shape) is hidden


def test_day_is_never_night_and_the_shadow_ends_where_its_cone_does():
    light = np.array([[1.0], [0.0], [0.0]])
    assert sun.shadow_rad(7e6 * light, light, "sphere")[0] < -1.0
    tip_m = RE * sun.ASTRONOMICAL_UNIT_M / (sun.SUN_RADIUS_M - RE)
    assert sun.shadow_rad(-0.9999 * tip_m * light, light, "sphere")[0] > 0.0
    assert sun.shadow_rad(-1.0001 * tip_m * light, light, "sphere")[0] < 0.0
    with pytest.raises(OrbitError, match=r"sample 0 is at 0\.9\d* Earth radii, inside the Earth"):
        sun.shadow_rad(6e6 * light, light, "sphere")
    with pytest.raises(OrbitError, match=r"sample 1 is at 0\.5\d* Earth radii"):  # the deepest
        sun.shadow_rad(np.array([[6e6, 3.5e6, 9e6]]) * light, np.repeat(light, 3, axis=1), "sphere")


def test_on_the_ground_below_the_sun_it_is_day_and_opposite_it_is_night():
    light = np.array([[1.0], [0.0], [0.0]])
    ground = np.array([[RE], [0.0], [0.0]])
    assert sun.shadow_rad(ground, light, "sphere")[0] == pytest.approx(-math.pi / 2.0, abs=5e-3)
    assert sun.shadow_rad(-ground, light, "sphere")[0] == pytest.approx(math.pi / 2.0, abs=5e-3)


def test_the_sun_is_as_wide_as_the_almanac_says():
    assert math.degrees(math.asin(sun.SUN_RADIUS_M / sun.ASTRONOMICAL_UNIT_M)) * 3600.0 == pytest.approx(959.6, abs=0.4)


# ---- Kepler's ellipse
ELLIPSE = analytic.KeplerOrbit("ellipse", START, 26_600e3, 0.74, 1.1, 2.0, 4.7, 0.5, True)
LOW = analytic.KeplerOrbit("low", START, 7_400e3, 0.1, 1.2, 1.0, 0.7, 0.2, True)
ORBITS = {
    "circle": LEO,
    "drifting circle": analytic.circular("c", START, 700e3, 1.713, 1.0, 2.0, True),
    "retrograde": analytic.circular("r", START, 700e3, math.pi, 1.0, 2.0, True),
    "ellipse": ELLIPSE,
    "two-body ellipse": dataclasses.replace(ELLIPSE, j2=False),
    "long": analytic.KeplerOrbit("long", START, 650_000e3, 0.989, 0.4, 1.0, 2.0, 6.27, True),
    "slot": SLOT,
}
each_orbit = pytest.mark.parametrize("orbit", ORBITS.values(), ids=ORBITS.keys())


@quick
@given(st.floats(-50.0, 50.0), st.one_of(st.floats(0.0, 0.99999), st.sampled_from([0.0, 0.5, 0.9, 0.999999])))
def test_keplers_equation_is_solved_for_any_ellipse(mean, e):
    found = float(analytic.eccentric_anomaly_rad(np.array([mean]), e)[0])
    assert found - e * math.sin(found) == pytest.approx(mean, abs=2e-14)  # the spacing of floats near 50 is 7e-15


@pytest.mark.parametrize("e", [1e-9, 0.01, 0.7, 0.999])
def test_newton_meets_the_root_that_bracketing_finds(e):
    mean = np.concatenate((np.linspace(-math.pi, math.pi, 61), [1e-12, 1e-6, 1e-3]))
    slow = [brentq(lambda E, m=m: E - e * math.sin(E) - m, m - 1.0, m + 1.0, xtol=1e-15, rtol=1e-15) for m in mean]
    worst = 2e-15 / (1.0 - e)  # rounding of the equation near the perigee, in the slow solver as well
    np.testing.assert_allclose(analytic.eccentric_anomaly_rad(mean, e), slow, rtol=0.0, atol=max(rounding_rad, worst))


@each_orbit
def test_velocity_is_the_derivative_of_the_position(orbit):
    time_s = np.linspace(-2e5, 2e5, 3001)
    step = 0.5
    r = [orbit.states(time_s + k * step).position_m for k in (-2, -1, 1, 2)]
    slope = (8.0 * (r[2] - r[1]) - (r[3] - r[0])) / (12.0 * step)
    v = orbit.states(time_s).velocity_m_s
    assert np.max(length(v - slope) / length(v)) < 1e-6


def flown(orbit, span_s, j2, times):
    """The orbit from its state at the epoch by numerical integration under `gravity`."""
    first = np.concatenate(orbit.states(np.array(0.0)))

    def slope(_, y):
        return np.concatenate((y[3:], earth.gravity(y[:3], j2)))

    flight = solve_ivp(slope, (0.0, span_s), first, "DOP853", t_eval=times, rtol=1e-12, atol=1e-6)
    return flight.y[:3], flight.y[3:]


@pytest.mark.promise("day-42")
@pytest.mark.parametrize("name", ["circle", "two-body ellipse"])
def test_two_bodies_move_as_integration_says(name):
    orbit = ORBITS[name]
    times = np.linspace(0.0, 40_000.0, 50)
    position, velocity = flown(orbit, times[-1], False, times)
    states = orbit.states(times)
    assert np.max(length(states.position_m - position)) < 0.05
    assert np.max(length(states.velocity_m_s - velocity)) < one_millimetre
    assert length(states.position_m[:, 0]) >= orbit.semi_major_axis_m * (1.0 - orbit.eccentricity) * (1.0 - 1e-12)


def elements(r, v):
    """Osculating semi-major axis, node, perigee and mean anomaly."""
    h = np.cross(r, v, axis=0)
    e = np.cross(v, h, axis=0) / MU_M3_S2 - r / length(r)
    axis = 1.0 / (2.0 / length(r) - np.sum(v * v, axis=0) / MU_M3_S2)
    node = np.arctan2(h[0], -h[1])
    n = np.stack((np.cos(node), np.sin(node), 0.0 * node))
    m = np.cross(h / length(h), n, axis=0)
    perigee = np.arctan2(np.sum(e * m, axis=0), np.sum(e * n, axis=0))
    true = np.arctan2(np.sum(r * m, axis=0), np.sum(r * n, axis=0)) - perigee
    size = length(e)
    eccentric = np.arctan2(np.sqrt(1.0 - size**2) * np.sin(true), np.cos(true) + size)
    return axis, size, np.unwrap(node), np.unwrap(perigee), np.unwrap(eccentric - size * np.sin(eccentric))


@pytest.mark.promise("readme-8")
@pytest.mark.promise("day-10")
@pytest.mark.parametrize("inclination_deg", [28.0, 63.4, 97.4])
def test_the_drifts_are_those_of_a_day_of_integration(inclination_deg):
    """Means over one turn at both ends of a day; what is left is of second order in J2, a thousandth."""
    orbit = dataclasses.replace(
        LOW, semi_major_axis_m=9.5e6, eccentricity=0.3, inclination_rad=math.radians(inclination_deg)
    )
    samples, turns = 240, 9
    period = 2.0 * math.pi / sum(orbit.secular_rates_rad_s()[2:])
    second_order = 0.005
    times = np.arange(samples * (turns + 1)) * (period / samples)
    axis, size, *angles = elements(*flown(orbit, times[-1], True, times))
    mean = dataclasses.replace(orbit, semi_major_axis_m=np.mean(axis[:samples]), eccentricity=np.mean(size[:samples]))
    found = [np.mean(a[-samples:] - a[:samples]) / (turns * period) for a in angles]
    node, perigee, anomaly = mean.secular_rates_rad_s()
    scale = 1.5 * earth.J2 * (RE / mean.semi_major_axis_m) ** 2 * mean.mean_motion_rad_s
    assert abs(found[0] - node) < second_order * scale
    assert abs(found[1] - perigee) < second_order * scale
    assert abs(found[2] - anomaly) < second_order * scale
    assert abs(found[2] - mean.mean_motion_rad_s) > 0.2 * scale or inclination_deg == 63.4
    assert abs(node) > 0.1 * scale


def test_without_flattening_nothing_drifts():
    assert dataclasses.replace(LOW, j2=False).secular_rates_rad_s() == (0.0, 0.0, LOW.mean_motion_rad_s)


@pytest.mark.promise("day-10")
def test_flattening_turns_a_circle_and_leaves_it_one():
    """No periodic term: neither its radius nor its inclination swings."""
    orbit = analytic.circular("c", START, 500e3, math.radians(60.0), 0.5, 0.0, True)
    r, v = orbit.states(np.linspace(0.0, 2.0 * DAY_S, 500))
    np.testing.assert_allclose(length(r), RE + 500e3, rtol=1e-12)
    normal = np.cross(r, v, axis=0)
    node = np.unwrap(np.arctan2(normal[0], -normal[1]))
    assert abs(node[-1] - node[0]) > 0.1
    turned = np.cross(r[:, :-1], r[:, 1:], axis=0)  # nearly the normal: the plane turns by 0.01 deg between two of them
    tilt = np.arccos(turned[2] / length(turned))
    np.testing.assert_allclose(np.minimum(tilt, math.pi - tilt), math.radians(60.0), rtol=0.0, atol=2e-3)


@pytest.mark.promise("day-8")
def test_a_circle_starts_at_its_phase_past_the_node():
    orbit = analytic.circular("c", START, 500e3, math.radians(60.0), 0.5, math.pi / 2, True)
    r, v = orbit.states(np.array([0.0]))
    top = (RE + 500e3) * np.array([-math.sin(0.5) * 0.5, math.cos(0.5) * 0.5, math.sqrt(0.75)])
    np.testing.assert_allclose(r[:, 0], top, rtol=0.0, atol=ten_micrometres)
    assert abs(v[2, 0]) < 1e-9
    assert length(v[:, 0]) == pytest.approx(7616.6, rel=2e-3)


@each_orbit
def test_any_order_and_any_shape_of_times_gives_the_same_states(orbit):
    time_s = np.linspace(0.0, 1e5, 11)
    r, v = orbit.states(time_s)
    backwards = orbit.states(time_s[::-1])
    np.testing.assert_allclose(backwards.position_m[:, ::-1], r, rtol=1e-12)
    single = orbit.states(time_s[4])
    assert single.position_m.shape == (3,)
    np.testing.assert_allclose(single.velocity_m_s, v[:, 4], rtol=1e-9, atol=1e-6)
    assert orbit.states(np.empty(0)).position_m.shape == (3, 0)
    with pytest.raises(OrbitError, match="number"):
        orbit.states(np.array([0.0, math.nan]))


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"eccentricity": 1.0}, r"KeplerOrbit\.eccentricity of low is 1: it must be finite, at least 0 and below 1"),
        (
            {"eccentricity": -0.1},
            r"KeplerOrbit\.eccentricity of low is -0\.1: it must be finite, at least 0 and below 1",
        ),
        ({"eccentricity": 0.7}, r"perigee is -4158\.14 km over the equator, below 120 km: it has decayed"),
        ({"semi_major_axis_m": 700e3}, "it has decayed; raise the altitude or the semi-major axis"),
        (
            {"inclination_rad": 3.2},
            r"inclination_rad of low is 183\.3 deg: it must be finite, at least 0 deg, at most 180 deg",
        ),
        ({"node_rad": math.nan}, r"KeplerOrbit\.node_rad of low is nan rad: it must be finite"),
        ({"semi_major_axis_m": math.inf}, r"KeplerOrbit\.semi_major_axis_m of low is inf m: it must be finite"),
        ({"mean_anomaly_rad": math.inf}, r"KeplerOrbit\.mean_anomaly_rad of low is inf rad: it must be finite"),
        (
            {"argument_of_perigee_rad": math.nan},
            r"KeplerOrbit\.argument_of_perigee_rad of low is nan rad: it must be finite",
        ),
    ],
)
def test_elements_that_are_no_orbit_are_refused(changes, words):
    with pytest.raises(OrbitError, match=words) as refused:
        dataclasses.replace(LOW, **changes)
    assert any(where in str(refused.value) for where in ("orbit low", "of low"))


def test_the_lowest_perigee_is_taken_and_a_metre_less_is_not():
    analytic.circular("c", START, 120e3, 0.0, 0.0, 0.0, False)
    with pytest.raises(OrbitError, match=r"perigee is 119\.999 km"):
        analytic.circular("c", START, 119_999.0, 0.0, 0.0, 0.0, False)


# ---- sun-synchronous
def test_the_sun_synchronous_inclination_at_500_km_is_97_4_degrees():
    assert math.degrees(analytic.sun_synchronous_inclination_rad(500e3)) == pytest.approx(97.4, abs=0.01)


@pytest.mark.parametrize(("altitude_m", "e"), [(300e3, 0.0), (500e3, 0.0), (1500e3, 0.1), (5900e3, 0.0)])
def test_a_sun_synchronous_node_goes_round_once_in_a_tropical_year(altitude_m, e):
    inclination = analytic.sun_synchronous_inclination_rad(altitude_m, e)
    orbit = analytic.KeplerOrbit("s", START, RE + altitude_m, e, inclination, 0.0, 0.0, 0.0, True)
    assert orbit.secular_rates_rad_s()[0] * 365.24219 * DAY_S == pytest.approx(2.0 * math.pi, rel=1e-12)


def test_an_altitude_or_eccentricity_without_a_sun_synchronous_orbit_is_refused():
    analytic.sun_synchronous_inclination_rad(5974e3)
    for altitude, words in (
        (5975e3, "can be sun-synchronous"),
        (-7e6, "centre"),
        (-RE, "centre"),
        (math.nan, "centre"),
    ):
        with pytest.raises(OrbitError, match=words):
            analytic.sun_synchronous_inclination_rad(altitude)
    with pytest.raises(OrbitError, match="take an altitude of at most 6658 km"):
        analytic.sun_synchronous_inclination_rad(7000e3, 0.3)
    analytic.sun_synchronous_inclination_rad(6658e3, 0.3)
    for eccentricity in (1.0, 1.5, -1e-9, math.nan):
        with pytest.raises(OrbitError, match=f"eccentricity {eccentricity:.6g} is not from 0"):
            analytic.sun_synchronous_inclination_rad(500e3, eccentricity)


@pytest.mark.promise("day-8")
@pytest.mark.parametrize("hours", [0.0, 10.5, 18.0])
def test_a_node_of_local_time_stays_at_its_hour_from_the_mean_sun(hours):
    """The true Sun runs up to 17 min before or behind the mean Sun; over a year the mean difference goes away."""
    morning = Epoch("2026-05-04T07:30:00Z")
    node = analytic.node_of_local_time(morning, hours)
    assert 0.0 <= node < 2.0 * math.pi
    orbit = analytic.circular("s", morning, 500e3, analytic.sun_synchronous_inclination_rad(500e3), node, 0.0, True)
    time_s = np.linspace(0.0, 365.2422 * DAY_S, 200, endpoint=False)
    light = sun.sun_direction(morning, time_s)
    drift = orbit.secular_rates_rad_s()[0] * time_s
    apart_h = wrapped(node + drift - np.arctan2(light[1], light[0]) - math.pi * (hours / 12.0 - 1.0)) * 12.0 / math.pi
    assert abs(np.mean(apart_h)) * 60.0 < 0.3
    assert 14.0 < np.max(np.abs(apart_h)) * 60.0 < 17.5


def test_a_node_of_noon_is_at_the_longitude_where_it_is_noon():
    node = analytic.node_of_local_time(START, 12.0)
    assert node == pytest.approx(float(START.earth_rotation_rad(0.0)) % (2.0 * math.pi))
    for hours in (24.0, -0.1, math.nan):
        with pytest.raises(OrbitError, match=f"a local time of {hours:.6g} h is not from 0 to below 24"):
            analytic.node_of_local_time(START, hours)


# ---- the low satellite and the slot
@pytest.mark.promise("readme-8")
@pytest.mark.promise("day-8")
def test_a_slot_stands_over_its_longitude():
    time_s = np.linspace(0.0, 10.0 * DAY_S, 100)
    below = earth.subpoint(SLOT.states(time_s).position_m, START.earth_rotation_rad(time_s))
    np.testing.assert_allclose(below.longitude_rad, 0.4, rtol=0.0, atol=1e-12)
    np.testing.assert_allclose(below.latitude_rad, 0.0, rtol=0.0, atol=1e-15)
    with pytest.raises(OrbitError, match=r"longitude_rad of GEO is 400 deg: .* at least -360 deg, at most 360 deg"):
        analytic.GeostationarySlot("GEO", START, math.radians(400.0))


def limits_of_first_contact(surface):
    def clearance(t):
        t = np.atleast_1d(t)
        return surface.clearance_rad(LEO.states(t).position_m, SLOT.states(t).position_m)

    grid = np.arange(0.0, 20_000.0, 10.0)
    signs = np.flatnonzero(np.diff(clearance(grid) > 0.0))
    first = signs[0] if clearance(grid[signs[0] + 1]) > 0.0 else signs[1]
    last = signs[np.searchsorted(signs, first) + 1]
    return tuple(brentq(lambda t: clearance(t)[0], grid[k], grid[k + 1], xtol=1e-6) for k in (first, last))


@pytest.mark.parametrize(("height_m", "minutes"), [(0.0, 58.12), (100e3, 56.72)])
@pytest.mark.parametrize("shape", ["sphere", "oblate"])
def test_the_contact_of_an_equatorial_orbit_at_500_km_and_a_slot_lasts_as_computed_by_hand(shape, height_m, minutes):
    start, end = limits_of_first_contact(earth.Earth(shape, height_m))
    assert (end - start) / MINUTE_S == pytest.approx(minutes, abs=half_a_hundredth_minute)
    synodic = 2.0 * math.pi / (LEO.mean_motion_rad_s - ROTATION_RAD_S)
    radii = (LEO.semi_major_axis_m, GEOSTATIONARY_RADIUS_M)
    closed = synodic / math.pi * sum(math.acos((RE + height_m) / r) for r in radii)
    assert end - start == pytest.approx(closed, abs=1e-3)


def test_the_range_of_that_contact_is_the_known_one():
    start, end = limits_of_first_contact(SPHERE)
    time_s = np.linspace(start, end, 4001)
    distance = length(SLOT.states(time_s).position_m - LEO.states(time_s).position_m)
    assert distance.min() / 1e3 == pytest.approx(35_286, abs=1.0)
    assert distance.max() / 1e3 == pytest.approx(44_253, abs=1.5)


def a_day_over_node_and_phase(height_m):
    """Largest rate, range rate and transverse speed, and share of the day in sight, for 24 sun-synchronous orbits."""
    surface = earth.Earth("sphere", height_m)
    time_s = np.arange(0.0, DAY_S, 20.0)
    slot = SLOT.states(time_s)
    inclination = analytic.sun_synchronous_inclination_rad(500e3)
    for node, phase in itertools.product(np.arange(6) * math.pi / 3, np.arange(4) * math.pi / 2):
        low = analytic.circular("s", START, 500e3, inclination, node, phase, True).states(time_s)
        free = surface.clearance_rad(low.position_m, slot.position_m) > 0.0
        line, speed = (b[:, free] - a[:, free] for a, b in zip(low, slot, strict=True))
        along = np.sum(line * speed, axis=0) / length(line)
        across = np.sqrt(np.sum(speed * speed, axis=0) - along**2)
        yield np.max(across / length(line)), np.max(np.abs(along)), np.max(across), np.mean(free)


@pytest.mark.parametrize(("height_m", "least", "most"), [(0.0, 0.65, 0.69), (100e3, 0.63, 0.66)])
def test_a_sun_synchronous_orbit_at_500_km_sees_a_slot_as_long_and_as_fast_as_is_known(height_m, least, most):
    rate, along, across, share = np.array(list(a_day_over_node_and_phase(height_m))).T
    assert least - 0.005 < share.min() < share.max() < most + 0.005
    assert rate.max() == pytest.approx(255e-6, abs=2e-6)
    assert along.max() / 1.55e-6 == pytest.approx(4.95e9, abs=0.02e9)
    assert 2.0 * across.max() / SPEED_OF_LIGHT_M_S == pytest.approx(71e-6, abs=1e-6)


# ---- stations
STATIONS = [
    (48.0862, 11.2795, 600.0),
    (-33.9, -70.5, 2400.0),
    (90.0, 0.0, 0.0),
    (-90.0, 10.0, 2800.0),
    (0.0, 359.0, -20),
]


def station(latitude_deg, longitude_deg, height_m, mask_deg=5.0):
    return earth.Station("G", math.radians(latitude_deg), math.radians(longitude_deg), height_m, math.radians(mask_deg))


@pytest.mark.promise("day-9", "day-11")
@pytest.mark.parametrize("site", STATIONS)
def test_a_station_stands_where_astropy_has_it_and_turns_with_the_earth(site):
    time_s = np.linspace(0.0, DAY_S, 25)
    angle = START.earth_rotation_rad(time_s)
    states = station(*site).position(START, time_s)
    fixed = EarthLocation.from_geodetic(site[1], site[0], site[2]).geocentric
    x, y, z = (c.to_value("m") for c in fixed)
    wanted = np.stack((np.cos(angle) * x - np.sin(angle) * y, np.sin(angle) * x + np.cos(angle) * y, 0.0 * angle + z))
    np.testing.assert_allclose(states.position_m, wanted, rtol=0.0, atol=ten_micrometres)
    axis = np.array([[0.0], [0.0], [ROTATION_RAD_S]])
    np.testing.assert_allclose(states.velocity_m_s, np.cross(axis, wanted, axis=0), rtol=0.0, atol=1e-9)
    below = earth.subpoint(states.position_m, angle)
    np.testing.assert_allclose(below.height_m, site[2], rtol=0.0, atol=ten_micrometres)
    np.testing.assert_allclose(below.latitude_rad, math.radians(site[0]), rtol=0.0, atol=1e-11)


@pytest.mark.promise("day-42")
@pytest.mark.parametrize("site", STATIONS)
def test_elevation_is_that_of_skyfield(site):
    from skyfield.api import load, wgs84
    from skyfield.positionlib import Geocentric
    from skyfield.sgp4lib import TEME

    time_s = np.linspace(0.0, DAY_S, 40)
    position_m = analytic.circular("c", START, 1200e3, 1.5, 0.2, 0.1, True).states(time_s).position_m
    moment = load.timescale(builtin=True).utc(2026, 3, 20, 12, 0, time_s)
    inertial = np.einsum("jin,jn->in", TEME.rotation_at(moment), position_m / 1000.0 / 149_597_870.7)
    place = wgs84.latlon(site[0], site[1], elevation_m=site[2])
    wanted, _, _ = (Geocentric(inertial, t=moment, center=399) - place.at(moment)).altaz()
    found = earth.elevation_rad(station(*site), START, time_s, position_m)
    np.testing.assert_allclose(found, wanted.radians, rtol=0.0, atol=1e-9)
    assert found.min() < -0.5


def test_overhead_is_ninety_degrees_and_the_horizon_nought():
    g = station(48.0, 11.0, 600.0)
    time_s = np.array([0.0, 1234.5])
    up = g.vertical(START, time_s)
    r = g.position(START, time_s).position_m
    np.testing.assert_allclose(length(up), 1.0, rtol=1e-15)
    np.testing.assert_allclose(earth.elevation_rad(g, START, time_s, r + 5e5 * up), math.pi / 2, rtol=0.0, atol=1e-7)
    east = np.cross(np.array([[0.0], [0.0], [1.0]]), up, axis=0)
    np.testing.assert_allclose(earth.elevation_rad(g, START, time_s, r + 1e6 * east), 0.0, rtol=0.0, atol=1e-14)


@pytest.mark.parametrize(
    ("site", "words"),
    [
        ((90.1, 0.0, 0.0), r"latitude_rad of G is 90\.1 deg: it must be finite, at least -90 deg, at most 90 deg"),
        ((math.nan, 0.0, 0.0), r"latitude_rad of G is nan deg: it must be finite, at least -90 deg, at most 90 deg"),
        ((0.0, 361.0, 0.0), r"longitude_rad of G is 361 deg: it must be finite, at least -360 deg, at most 360 deg"),
        ((0.0, 0.0, 0.0, 90.0), r"mask_rad of G is 90 deg: it must be finite, at least 0 deg and below 90 deg"),
        ((0.0, 0.0, 0.0, -1.0), r"mask_rad of G is -1 deg: it must be finite, at least 0 deg and below 90 deg"),
        ((0.0, 0.0, 6378137.0), r"height_m of G is 6378 km: it must be finite, at least -1 km, at most 50 km"),
    ],
)
def test_a_place_that_is_none_is_refused(site, words):
    with pytest.raises(OrbitError, match=words) as refused:
        station(*site)
    assert " of G is " in str(refused.value)


SITE = earth.Station("site", -0.61, 1.93, 812.5, 0.17)
TURNED = analytic.KeplerOrbit("turned", START, 9.1e6, 0.21, 1.93, 0.7, -1.1, 2.6, True)
SEEN = np.array([[4.1e6, -5.3e6], [-3.3e6, 2.9e6], [5.2e6, -6.1e6]])


@pytest.mark.parametrize(
    ("found", "expected"),
    [
        (lambda: place_m(-0.61, 812.5), [5234245.41, -3633825.83]),
        (
            lambda: [*SITE.position(START, np.array([0.0, 3605.5])).position_m.ravel()],
            [-1670831.16, -2902617.87, 4960408.07, 4355701.38, -3633825.83, -3633825.83],
        ),
        (
            lambda: [
                *SITE.position(START, np.array([0.0, 3605.5])).velocity_m_s[:2].ravel(),
                *SITE.vertical(START, np.array([3605.5])).ravel(),
            ],
            [-361.718704, -317.622791, -121.838944, -211.662258, -0.454530652, 0.682073867, -0.57286746],
        ),
        (
            lambda: [
                *earth.elevation_rad(SITE, START, np.array([0.0, 3605.5]), SEEN),
                *earth.GroundSite(SITE, START).above_mask(np.array([0.0, 3605.5]), SEEN),
            ],
            [-1.32170331, 0.4160993, -1.49170331, 0.2460993],
        ),
        (
            lambda: [
                *earth.subpoint(SEEN, np.array([0.4, 2.7])).latitude_rad,
                *earth.subpoint(SEEN, np.array([0.4, 2.7])).longitude_rad,
                *earth.subpoint(SEEN, np.array([0.4, 2.7])).height_m,
            ],
            [0.782259782, -0.792705008, -1.07770829, -0.0590750713, 1031096.88, 2218128.8],
        ),
        (
            lambda: [*earth.gravity(SEEN, True).ravel(), *earth.gravity(SEEN, False).ravel()],
            [
                -4.02803621,
                3.33372976,
                3.24207792,
                -1.82411629,
                -5.12108169,
                3.8438214,
                -4.03519422,
                3.33828975,
                3.24783925,
                -1.82661137,
                -5.1178073,
                3.84218254,
            ],
        ),
        (
            lambda: [
                *earth.Earth("oblate", 123e3).clearance_rad(SEEN, -1.4 * SEEN[:, ::-1]),
                *earth.Earth("sphere", 37e3).clearance_rad(SEEN, SEEN[::-1]),
            ],
            [1.37561607, 1.48181952, 0.832367975, 1.32201114],
        ),
        (
            lambda: [*earth.Earth("oblate", 123e3).height_m(SEEN), *earth.Earth("sphere", 37e3).height_m(SEEN)],
            [1031096.88, 2218128.8, 1020511.53, 2207315.81],
        ),
        (
            lambda: [
                *sun.sun_direction(START, np.array([0.0, 8.64e6])).ravel(),
                *sun.shadow_rad(SEEN, sun.sun_direction(START, np.array([0.0, 8.64e6])), "oblate"),
            ],
            [
                0.999998209,
                -0.118768679,
                -0.00173659842,
                0.911016761,
                -0.000752759179,
                0.394895508,
                -1.1254191,
                -0.838394864,
            ],
        ),
        (
            lambda: [*TURNED.secular_rates_rad_s(), TURNED.mean_motion_rad_s],
            [2.23212097e-07, -1.21323876e-07, 0.000727093298, 0.000727288632],
        ),
        (
            lambda: [*TURNED.states(np.array([0.0, 5432.1])).position_m.ravel()],
            [1570532.57, 3258812.66, -3623071.46, 4881298.36, 10074310.2, -4333496.75],
        ),
        (
            lambda: [*TURNED.states(np.array([0.0, 5432.1])).velocity_m_s.ravel()],
            [-4191.50211, 5579.39767, -3501.49256, 2010.20139, -59.6638823, 5499.05351],
        ),
        (
            lambda: [
                *dataclasses.replace(TURNED, j2=False).states(np.array([5432.1])).position_m.ravel(),
                *dataclasses.replace(TURNED, j2=False).states(np.array([5432.1])).velocity_m_s.ravel(),
            ],
            [3276044.62, 4881220.93, -4321980.96, 5577.97188, 1992.63457, 5511.07955],
        ),
        (
            lambda: [*analytic.eccentric_anomaly_rad(np.array([-9.0, -0.4, 0.0, 3.3, 20.0]), 0.63)],
            [-9.16302671, -0.889262711, 0.0, 3.23883428, 20.6177638],
        ),
        (
            lambda: [
                *analytic.GeostationarySlot("slot", START, -2.2).states(np.array([98.7])).position_m[:2].ravel(),
                *analytic.GeostationarySlot("slot", START, -2.2).states(np.array([98.7])).velocity_m_s[:2].ravel(),
            ],
            [-25728566.6, -33404461.7, 2435.89205, -1876.15688],
        ),
        (
            lambda: [
                analytic.sun_synchronous_inclination_rad(812e3, 0.07),
                analytic.node_of_local_time(Epoch("2026-07-09T17:30:15Z"), 9.25),
            ],
            [1.72034834, 1.15920092],
        ),
        (
            lambda: [
                *Epoch("2026-07-09T17:30:15.5Z").julian_date,
                Epoch("2008-12-31T23:00:00Z").seconds_to(Epoch("2017-01-01T01:00:00.25Z")),
                float(START.terrestrial_centuries(np.array(1234.5))),
            ],
            [2461230.5, 0.729346065, 252468004.0, 0.262149626],
        ),
        (
            lambda: [*START.earth_rotation_rad(np.array([-2e5, 0.0, 7654.3, 3e6]))],
            [-8.33535259, 6.24887894, 6.80703936, 225.012354],
        ),
    ],
)
def test_places_times_and_states_of_numbers_unlike_each_other(found, expected):
    assert list(found()) == pytest.approx(expected, rel=1e-6, abs=0.0, nan_ok=True)


@pytest.mark.parametrize(
    ("found", "expected"),
    [
        (
            lambda: [START.utc(each) for each in (-0.0004, 59.9996, 3599.9994, 43200.0)],
            [
                "2026-03-20T12:00:00.000Z",
                "2026-03-20T12:01:00.000Z",
                "2026-03-20T12:59:59.999Z",
                "2026-03-21T00:00:00.000Z",
            ],
        ),
        (
            lambda: [Epoch("2016-12-31T23:59:58.25Z").utc(each) for each in (1.7494, 1.75, 2.7494, 2.75, -86398.25)],
            [
                "2016-12-31T23:59:59.999Z",
                "2016-12-31T23:59:60.000Z",
                "2016-12-31T23:59:60.999Z",
                "2017-01-01T00:00:00.000Z",
                "2016-12-31T00:00:00.000Z",
            ],
        ),
        (
            lambda: [Epoch("2026-12-31T23:59:59.5Z").utc(each) for each in (0.4996, 1.0, 86400.0, 5097600.0)],
            [
                "2027-01-01T00:00:00.000Z",
                "2027-01-01T00:00:00.500Z",
                "2027-01-01T23:59:59.500Z",
                "2027-02-28T23:59:59.500Z",
            ],
        ),
        (
            lambda: [
                Epoch("2026-03-20T01:02Z").text,
                Epoch("2026-03-20 01:02:03.10+0000").text,
                Epoch("2026-03-20T01:02:00.000+00:00").text,
            ],
            ["2026-03-20T01:02:00Z", "2026-03-20T01:02:03.1Z", "2026-03-20T01:02:00Z"],
        ),
    ],
)
def test_instants_are_written_to_the_millisecond_over_minutes_days_and_leap_seconds(found, expected):
    assert found() == expected


PLACES = np.array([[RE + 3e5, RE + 2.5e5, RE + 7e4], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]])


@pytest.mark.parametrize(
    ("call", "error", "words"),
    [
        (
            lambda: earth.Earth("sphere", 80e3).clearance_rad(PLACES, PLACES + 1e6),
            OrbitError,
            (
                "the first terminal (sample 2) is 9.87613 km below the surface that lines of sight must "
                "clear, 80 km over the Earth; lower the grazing height or raise the orbit"
            ),
        ),
        (
            lambda: earth.Earth("oblate", 90.5e3).clearance_rad(PLACES + 1e6, PLACES[:, ::-1]),
            OrbitError,
            (
                "the second terminal (sample 0) is 20.2132 km below the surface that lines of sight must "
                "clear, 90.5 km over the Earth; lower the grazing height or raise the orbit"
            ),
        ),
        (
            lambda: sun.shadow_rad(PLACES * np.array([1.0, 0.875, 1.0]), np.array([[1.0], [0.0], [0.0]]), "sphere"),
            OrbitError,
            ("sample 1 is at 0.909297 Earth radii, inside the Earth, where there is no day or night; check the orbit"),
        ),
        (
            lambda: analytic.KeplerOrbit("low", START, 7e6, 0.0925, 0.3, 0.4, 0.5, 0.6, True),
            OrbitError,
            (
                "orbit low: its perigee is -25.637 km over the equator, below 120 km: it has decayed; "
                "raise the altitude or the semi-major axis, or lower the eccentricity (a semi-major axis "
                "counts from the centre of the Earth)"
            ),
        ),
        (
            lambda: analytic.KeplerOrbit("low", START, 7e6, 0.0125, -0.3, 0.4, 0.5, 0.6, True),
            OrbitError,
            (
                "KeplerOrbit.inclination_rad of low is -17.19 deg: it must be finite, at least 0 deg, at "
                "most 180 deg; an orbit against the rotation of the Earth has more than 90 deg"
            ),
        ),
        (
            lambda: LEO.states(np.array([0.0, math.inf])),
            OrbitError,
            "orbit LEO: a time is not a finite number of seconds; check the span",
        ),
        (
            lambda: analytic.sun_synchronous_inclination_rad(6123.456e3),
            OrbitError,
            (
                "no orbit 6123.46 km over the equator can be sun-synchronous: the flattening turns its "
                "node too slowly; take an altitude of at most 5974 km"
            ),
        ),
        (
            lambda: analytic.node_of_local_time(START, 24.25),
            OrbitError,
            "a local time of 24.25 h is not from 0 to below 24; give hours, such as 10.5",
        ),
        (
            lambda: START.utc(-1.7e9),
            OrbitError,
            (
                "-1.7e+09 s after 2026-03-20T12:00:00Z is outside 1973-01-02 to 2050-12-31, the days for "
                "which the rotation of the Earth (UT1) is tabulated or can be extrapolated; take an "
                "instant between them"
            ),
        ),
        (
            lambda: START.utc(8.125e8),
            OrbitError,
            (
                "8.125e+08 s after 2026-03-20T12:00:00Z is outside 1973-01-02 to 2050-12-31, the days for "
                "which the rotation of the Earth (UT1) is tabulated or can be extrapolated; take an "
                "instant between them"
            ),
        ),
        (
            lambda: START.utc(math.inf),
            OrbitError,
            "a time of inf s after 2026-03-20T12:00:00Z is not a number; give finite seconds",
        ),
        (
            lambda: Epoch("2026-02-30T12:00:00Z"),
            OrbitError,
            (
                "'2026-02-30T12:00:00Z' names no day of the calendar (day is out of range for month); "
                'write the instant in UTC, for example "2026-03-20T12:00:00Z"'
            ),
        ),
        (
            lambda: Epoch("2026-03-20 12:00:00"),
            OrbitError,
            (
                "'2026-03-20 12:00:00' has no time zone, so the instant is not known; write the instant in "
                'UTC, for example "2026-03-20T12:00:00Z", with the Z'
            ),
        ),
        (
            lambda: Epoch("2015-12-31T23:59:60Z"),
            OrbitError,
            (
                "'2015-12-31T23:59:60Z' names a leap second, but none was inserted on that day; write the "
                'instant in UTC, for example "2026-03-20T12:00:00Z"'
            ),
        ),
        (
            lambda: Epoch("2016-12-31T24:00:00Z"),
            OrbitError,
            (
                "'2016-12-31T24:00:00Z' names no time of the day (24 hours, 60 minutes, 60 seconds); write "
                'the instant in UTC, for example "2026-03-20T12:00:00Z"'
            ),
        ),
        (
            lambda: Epoch("2051-01-02T03:04:05Z"),
            OrbitError,
            (
                "'2051-01-02T03:04:05Z' is outside 1973-01-02 to 2050-12-31, the days for which the "
                "rotation of the Earth (UT1) is tabulated or can be extrapolated; take an instant between "
                "them"
            ),
        ),
    ],
)
def test_a_refusal_of_orbits_and_places_says_every_number(call, error, words):
    with pytest.raises(error) as refused:
        call()
    assert str(refused.value) == words


@pytest.mark.parametrize(
    ("text", "inside_s", "outside_s"),
    [("2050-12-30T20:00:00Z", 100_799.0, 100_800.0), ("1973-01-02T20:00:00Z", -72_000.0, -72_000.1)],
)
def test_the_first_and_the_last_day_are_inside_to_their_ends_whatever_the_time_of_day(text, inside_s, outside_s):
    assert Epoch(text).utc(inside_s) in ("2050-12-31T23:59:59.000Z", "1973-01-02T00:00:00.000Z")
    with pytest.raises(OrbitError, match="outside 1973-01-02 to 2050-12-31"):
        Epoch(text).utc(outside_s)


def test_leap_seconds_are_counted_to_the_last_second_of_the_tables():
    first, last = Epoch("1973-01-02T00:00:00Z"), Epoch("2050-12-31T23:59:59Z")
    assert first.utc(first.seconds_to(last)) == "2050-12-31T23:59:59.000Z"
    assert last.utc(last.seconds_to(first)) == "1973-01-02T00:00:00.000Z"
    for one, beyond_s in ((first, first.seconds_to(last) + 1.0), (last, last.seconds_to(first) - 1.0)):
        with pytest.raises(OrbitError, match="outside 1973-01-02 to 2050-12-31"):
            one.utc(beyond_s)


@pytest.mark.parametrize("far_s", [-1.7e9, 8e8])
@pytest.mark.parametrize("place", [0, 1, 2])
def test_one_time_of_several_that_the_tables_do_not_have_is_named(far_s, place):
    epoch = Epoch("2026-03-20T12:00:00Z")
    time_s = np.insert(np.array([60.0, -60.0]), place, far_s)
    with pytest.raises(OrbitError) as refused:
        epoch.earth_rotation_rad(time_s)
    assert str(refused.value).startswith(
        f"{far_s:.6g} s after 2026-03-20T12:00:00Z is outside 1973-01-02 to 2050-12-31"
    )
    time_s[place] = math.nan
    with pytest.raises(OrbitError, match="a time of nan s after 2026-03-20T12:00:00Z is not a number"):
        epoch.earth_rotation_rad(time_s)


@pytest.mark.parametrize("time_s", [math.nan, math.inf, -math.inf])
def test_a_time_that_is_no_number_is_refused_by_an_orbit_of_a_formula_wherever_it_stands(time_s):
    for times in ([time_s, 0.0], [0.0, 1.0, time_s]):
        with pytest.raises(OrbitError, match=r"^orbit LEO: a time is not a finite number of seconds; check the span$"):
            LEO.states(np.array(times))
