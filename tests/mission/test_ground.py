"""A station as one end of a link: its range and elevation against vectors, and each refusal with its advice."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.optimize import brentq

from ground_files import SLOT, STATION, TURBULENCE, TYPED, UP, WIND, ground_file, ground_path
from link_files import data_with, link_file, written
from made_tables import made, one_line, told
from microrad.link import Shared
from microrad.mission.file import MissionError, load_link
from microrad.mission.ground import GroundPath, geocentric_radius_m, ground_fits, path_of, range_of
from microrad.mission.tables.channel import Channel, TurbulenceTable
from microrad.mission.tables.orbit import Orbits, OrbitTable
from microrad.orbit import Epoch, Station
from microrad.orbit.earth.figure import elevation_rad
from microrad.orbit.propagation.analytic import GeostationarySlot, KeplerOrbit

EQUATOR_M, FLAT = 6378137.0, 1.0 / 298.257223563
EPOCH = Epoch("2026-03-20T12:00:00Z")
START = np.zeros(1)
deg = math.pi / 180.0
one_metre = 1.0
TEIDE = GroundPath("geo", 20.0 * deg, 0.0, EQUATOR_M, EQUATOR_M + 500e3, ())


# ------------------------------------------------------------------------------------------------- range and elevation
def test_from_500_km_the_range_is_1193_km_at_20_deg_and_the_altitude_in_the_zenith():
    assert TEIDE.range_at(20.0 * deg) == pytest.approx(1193e3, abs=0.5e3)
    assert TEIDE.range_at(90.0 * deg) == pytest.approx(500e3, abs=1e-6)
    # the triangle of station, satellite and the Earth's centre by the law of cosines, solved for the third side
    for e in (10.0 * deg, 35.0 * deg, 80.0 * deg):
        found = brentq(
            lambda d, e=e: EQUATOR_M**2 + d**2 - 2.0 * EQUATOR_M * d * math.cos(e + math.pi / 2.0)
            - (EQUATOR_M + 500e3) ** 2,
            4e5,
            4e6,
            xtol=1e-6,
        )  # fmt: skip
        assert TEIDE.range_at(e) == pytest.approx(found, abs=1e-3)
        assert TEIDE.elevation_at(TEIDE.range_at(e)) == pytest.approx(e, abs=1e-12)
        assert TEIDE.at(e).altitude_of(TEIDE.range_at(e)) == pytest.approx(500e3, abs=1e-6)
        assert TEIDE.at(e).elevation_rad == e
    assert TEIDE.elevation_at(400e3) == math.pi / 2.0  # nearer than there can be


@pytest.mark.parametrize("latitude", [-70.0, 0.0, 28.3, 45.0, 90.0])
def test_a_places_distance_from_the_centre_is_that_of_its_position(latitude):
    station = Station("here", latitude * deg, 0.4, 2393.0, 20.0 * deg)
    position = station.position(EPOCH, START).position_m[:, 0]
    assert geocentric_radius_m(latitude * deg, 2393.0) == pytest.approx(np.linalg.norm(position), abs=1e-6)


@pytest.mark.parametrize("latitude", [0.0, 28.3, 45.0, -60.0])
@pytest.mark.parametrize("elevation", [10.0, 20.0, 45.0, 90.0])
def test_the_round_earth_is_wrong_by_no_more_than_the_plumb_line_leans(latitude, elevation):
    """A satellite is put at an elevation over the ellipsoid, in each direction, at a radius that is known.

    The plumb line leans on the line to the centre by the difference of the geodetic and the geocentric latitude; by so
    much at most is the elevation over the round Earth another one, at the same range. That moves the range by d range /
    d elevation times as much, to first order, and 1.02 times it with what the second order adds.
    """
    station = Station("here", latitude * deg, 0.4, 2393.0, 20.0 * deg)
    own, up = station.position(EPOCH, START).position_m[:, 0], station.vertical(EPOCH, START)[:, 0]
    radius, e = EQUATOR_M + 500e3, elevation * deg
    east = np.cross([0.0, 0.0, 1.0], up)
    east /= np.linalg.norm(east)
    north = np.cross(up, east)
    path = GroundPath("geo", e, 2393.0, geocentric_radius_m(latitude * deg, 2393.0), radius, ())
    leans = math.acos(min(float(own @ up) / float(np.linalg.norm(own)), 1.0))
    assert leans == pytest.approx(FLAT * abs(math.sin(2.0 * latitude * deg)), abs=2e-5)
    wrong = []
    for azimuth in np.arange(8) * math.pi / 4.0:
        level = math.cos(azimuth) * north + math.sin(azimuth) * east
        line = math.cos(e) * level + math.sin(e) * up
        ahead = float(own @ line)
        true = math.sqrt(ahead**2 + radius**2 - float(own @ own)) - ahead
        satellite = (own + true * line)[:, None]
        assert elevation_rad(station, EPOCH, START, satellite)[0] == pytest.approx(e, abs=1e-9)
        sideways = abs(path.elevation_at(true) - e)
        assert sideways <= leans * 1.0001 + 1e-7
        wrong.append(abs(path.range_at(e) - true))
    slope = abs((path.range_at(e - 1e-4) - path.range_at(min(e + 1e-4, math.pi / 2.0))) / 2e-4)
    bound = 1.02 * slope * leans + 2e6 * leans**2 + one_metre
    assert max(wrong) <= bound
    assert max(wrong) >= 0.9 * slope * leans - one_metre  # and towards the poles it is so much
    assert max(wrong) < 0.011 * path.range_at(e)  # 0.1 dB at most


@pytest.mark.promise("link-108")
def test_a_geostationary_satellite_stands_where_its_position_has_it(tmp_path):
    """The slot's radius is 42 164.17 km here, and there follows from the Earth's mass and turn: 2 m apart or less."""
    for slot in ("-10 deg", "20 deg", "-60 deg"):
        m = ground_file(tmp_path, {"orbit.leo": {"kind": "geostationary", "longitude": slot}}).mission
        station = Station("here", 28.3 * deg, -16.5 * deg, 2393.0, 20.0 * deg)
        there = GeostationarySlot("GEO", EPOCH, float(slot.split()[0]) * deg).states(START).position_m
        true = float(elevation_rad(station, EPOCH, START, there)[0])
        assert m.path.elevation_rad == pytest.approx(true, abs=1e-7)
        assert m.path.sources == ("orbit.geo.latitude", "orbit.leo.longitude")
        apart = float(np.linalg.norm(there - station.position(EPOCH, START).position_m))
        # the elevation is that over the ellipsoid, the range that over the round Earth: 0.16 deg of lean, 18 km
        assert m.range_m(m.communication) == pytest.approx(apart, abs=18e3)


@pytest.mark.promise("link-108")
def test_an_eccentric_orbit_counts_with_its_apogee(tmp_path):
    orbit = {
        "kind": "keplerian",
        "semi_major_axis": "7000 km",
        "eccentricity": 0.05,
        "inclination": "97.4 deg",
        "node": "0 deg",
        "argument_of_perigee": "90 deg",
        "mean_anomaly": "0 deg",
        "gravity": "two-body",
    }
    m = ground_file(tmp_path, {"orbit.leo": orbit}).mission
    flown = KeplerOrbit("sat", EPOCH, 7000e3, 0.05, 97.4 * deg, 0.0, 90.0 * deg, 0.0, False)
    furthest = np.linalg.norm(flown.states(np.arange(0.0, 6000.0)).position_m, axis=0).max()
    assert m.path.satellite_radius_m == pytest.approx(furthest, abs=5.0)
    assert m.path.sources == ("orbit.geo.mask", "orbit.leo.semi_major_axis")


@pytest.mark.promise("link-108")
def test_the_path_is_that_of_the_station_at_its_mask_at_either_end(tmp_path):
    down, up = (ground_file(tmp_path, each).mission for each in ({}, UP))
    assert (down.path.station, up.path.station) == ("geo", "leo")
    assert down.path.elevation_rad == up.path.elevation_rad == pytest.approx(20.0 * deg)
    assert down.path.sources == ("orbit.geo.mask", "orbit.leo.altitude")
    assert up.path.sources == ("orbit.leo.mask", "orbit.geo.altitude")
    for m in (down, up):
        assert m.range_m(m.communication) == m.range_m(m.answer) == m.path.range_at(20.0 * deg)
        assert m.path.height_m == 2393.0
    higher = ground_file(tmp_path, {"orbit.geo.mask": "40 deg"}).mission
    assert higher.range_m(higher.answer) < 0.7 * down.range_m(down.answer)


@pytest.mark.promise("link-108")
def test_elements_take_the_altitude_of_the_channel(tmp_path):
    elements = {"orbit.leo": {"kind": "elements", "file": "a.tle"}, "channel.altitude": "550 km"}
    m = ground_file(tmp_path, elements).mission
    assert m.path.satellite_radius_m == EQUATOR_M + 550e3
    assert m.path.sources == ("orbit.geo.mask", "channel.altitude")


@pytest.mark.promise("link-109")
def test_a_typed_elevation_has_the_range_of_its_altitude(tmp_path):
    m = ground_file(tmp_path, TYPED).mission
    low, high = EQUATOR_M + 2393.0, EQUATOR_M + 500e3
    rise, level = low * math.sin(20.0 * deg), low * math.cos(20.0 * deg)
    assert m.range_m(m.communication) == pytest.approx(math.sqrt(high**2 - level**2) - rise, abs=1e-6)
    assert m.path.sources == ("channel.elevation", "channel.altitude")
    assert m.path.doubt == ""


# ------------------------------------------------------------------------------------------------------------ refusals
BOTH_DOWN = {"orbit.leo": STATION}
TLE = {"orbit.leo": {"kind": "elements", "file": "a.tle"}}
BEYOND = {"orbit.leo": {"kind": "geostationary", "longitude": "160 deg"}}
LOW = {"orbit.leo": {"kind": "geostationary", "longitude": "45 deg"}}
NO_AIR = {"channel.aerosol_depth": None, "channel.angstrom_exponent": None, "channel.absorption": None}
FREE = {"attitude": "nadir", "boresight": [0.0, 0.0, 1.0], "field_of_regard": "60 deg", "slew_limit": "1 deg/s"}
FREE |= {"sun_exclusion": "0 deg", "in_eclipse": True}
MANY = {
    "pattern": "delta",
    "satellites": 2,
    "planes": 1,
    "phasing": 0,
    "terminals": 1,
    "overhead": "60 s",
    "session": "10 min",
    "shortest": "3 min",
    "relays": {"east": {"longitude": "143 deg"}},
}
REFUSED = [
    (BOTH_DOWN, "orbit.geo.kind", 'is "station", as is leo.kind: one of the two has to fly', "another kind of orbit"),
    (
        {"channel": None},
        "channel",
        'is missing, and orbit.geo is of kind "station": its links cross the air',
        "a table such as [channel] with zenith_transmission = 0.9",
    ),
    (
        {"channel.elevation": "30 deg"},
        "channel.elevation",
        "stands beside orbit.geo.mask, of which it follows",
        "this line removed",
    ),
    ({"channel.station": "geo"}, "channel.station", "stands beside orbit.geo, of which it follows", "removed"),
    ({"channel.height": "0 m"}, "channel.height", "stands beside orbit.geo, of which it follows", "removed"),
    ({"channel.altitude": "500 km"}, "channel.altitude", "stands beside orbit.leo, of which it follows", "removed"),
    (
        {"constellation": MANY},
        "constellation",
        'stands beside orbit.geo of kind "station", and means a satellite there',
        "the table removed, or a relay as orbit.geo",
    ),
    (
        {"communication.distance": "1000 km"},
        "communication.distance",
        "stands beside orbit.geo.mask and orbit.leo.altitude, of which a range of 1198 km follows",
        "no distance",
    ),
    (
        {"answer.distance": "1000 km"},
        "answer.distance",
        "stands beside orbit.geo.mask and orbit.leo.altitude, of which a range of 1198 km follows",
        "no distance",
    ),
    (
        TLE,
        "channel.altitude",
        'is missing, and orbit.leo of kind "elements" does not say it',
        'altitude = "500 km" would do: the largest over the station',
    ),
    (
        BEYOND,
        "orbit.leo.longitude",
        "leaves the satellite at an elevation of -65.13 deg over the station, below the horizon",
        "a slot that the station sees, or another station",
    ),
    (
        {**BEYOND, "communication.distance": "40000 km"},  # no range follows of an elevation below the horizon
        "orbit.leo.longitude",
        "leaves the satellite at an elevation of -65.13 deg over the station, below the horizon",
        "a slot that the station sees, or another station",
    ),
    (
        LOW,
        "orbit.leo.longitude",
        "leaves the satellite at an elevation of 16.51 deg over the station, below orbit.geo.mask of 20 deg",
        "a slot that the station sees, or another station",
    ),
    ({"orbit.geo.latitude": None}, "orbit.geo.latitude", 'is missing, and kind = "station" needs it', '"28.3 deg"'),
    ({"orbit.geo.longitude": None}, "orbit.geo.longitude", 'is missing, and kind = "station" needs it', '"-16.5 deg"'),
    ({"orbit.geo.height": None}, "orbit.geo.height", 'is missing, and kind = "station" needs it', '"2400 m"'),
    ({"orbit.geo.mask": None}, "orbit.geo.mask", 'is missing, and kind = "station" needs it', '"20 deg"'),
    ({"orbit.geo.altitude": "1 km"}, "orbit.geo.altitude", "is below 100 km", "at least 100 km"),
    ({"orbit.geo.node": "0 deg"}, "orbit.geo.node", 'does not belong to kind = "station"', "this line removed"),
    ({"orbit.leo.mask": "20 deg"}, "orbit.leo.mask", 'does not belong to kind = "circular"', "this line removed"),
    ({"orbit.geo.mask": "9 deg"}, "orbit.geo.mask", "is below 10 deg", "at least 10 deg"),
    ({"orbit.geo.limits": FREE}, "orbit.geo.limits.attitude", 'is "nadir", and a station has none', '"free"'),
    (
        {"requirement.outage": None, "jitter": None},
        "requirement.outage",
        "is missing, and the margin under channel.turbulence is the one that is kept but for it",
        "a share of the time, outage = 0.01 for 1 %",
    ),
    (
        {"channel.zenith_transmission": 0.9},
        "channel.aerosol_depth channel.angstrom_exponent channel.absorption",
        "stands beside zenith_transmission, which holds it",
        "one of the two removed",
    ),
    (
        NO_AIR,
        "channel.zenith_transmission",
        "is missing, and so is what it follows from",
        "zenith_transmission = 0.9 would do, or aerosol_depth, angstrom_exponent and absorption",
    ),
    (
        {"channel.absorption": None},
        "channel.absorption",
        "is missing, and the transmission follows from it",
        'absorption = "0.1 dB" would do, or zenith_transmission in place of all',
    ),
    (
        {"channel.angstrom_exponent": None, "channel.aerosol_depth": None},
        "channel.angstrom_exponent channel.aerosol_depth",
        "is missing, and the transmission follows from it",
        "would do, or zenith_transmission in place of all",
    ),
    (
        {"channel.turbulence.wind_rms": None},
        "channel.turbulence.wind_rms",
        "is missing, and so is the table wind",
        'wind_rms = "21 m/s" would do',
    ),
    (
        {"channel.turbulence.wind": WIND},
        "channel.turbulence.wind_rms",
        "stands beside the table wind, of which it follows",
        "one of the two removed",
    ),
    (
        {"channel.turbulence.corrected_modes": 1},
        "channel.turbulence.corrected_modes",
        "is 1: piston, or a tilt about one axis",
        "0 without adaptive optics, 3 for tip and tilt, or more",
    ),
    (
        {"channel.turbulence.corrected_modes": 2},
        "channel.turbulence.corrected_modes",
        "is 2: piston, or a tilt about one axis",
        "0 without adaptive optics, 3 for tip and tilt, or more",
    ),
    (
        {**TYPED, "channel.elevation": None, "communication.distance": "1000 km", "answer.distance": "1000 km"},
        "channel.elevation",
        "is missing, and no station in the table orbit says it",
        'elevation = "30 deg" would do',
    ),
    (
        {**TYPED, "channel.station": None},
        "channel.station",
        "is missing, and no station in the table orbit says it",
        'station = "geo" would do',
    ),
    (
        {**TYPED, "channel.height": None, "channel.turbulence": None},
        "channel.height",
        "is missing, and no station in the table orbit says it",
        'height = "0 m" would do',
    ),
    (
        {**TYPED, "channel.altitude": None, "answer.distance": "1000 km"},
        "communication.distance",
        "is missing",
        'distance = "42000 km" would do',
    ),
    (
        {**TYPED, "communication.distance": "1000 km"},
        "communication.distance",
        "stands beside channel.elevation and channel.altitude, of which a range of 1188 km follows",
        "no distance",
    ),
]


def faults(path):
    with pytest.raises(MissionError) as refused:
        load_link(path)
    return refused.value.faults


@pytest.mark.parametrize(("changes", "keys", "reason", "advice"), REFUSED)
@pytest.mark.promise("link-108", "link-110")
def test_what_does_not_fit_is_refused_by_its_key_and_with_what_to_do(tmp_path, changes, keys, reason, advice):
    found = faults(ground_path(tmp_path, changes))
    assert sorted(each.key for each in found) == sorted(keys.split())
    for each in found:
        assert reason in each.reason
        assert advice in each.expected


@pytest.mark.promise("link-108")
def test_each_of_several_distances_is_refused(tmp_path):
    typed = {"communication.distance": "1000 km", "answer.distance": "900 km"}
    assert [each.key for each in faults(ground_path(tmp_path, typed))] == ["communication.distance", "answer.distance"]


def test_turbulence_is_not_left_before_the_light_is_above_it(tmp_path):
    typed = {**TYPED, "channel.altitude": None, "answer.distance": "100 km"}
    (fault,) = faults(ground_path(tmp_path, typed, {"communication.distance": "99 km"}))
    assert fault.key == "communication.distance"
    assert fault.reason == "is below 100 km, up to which the air of channel.turbulence reaches"
    assert 'distance = "1000 km" would do' in fault.expected
    assert ground_file(tmp_path, typed, {"communication.distance": "100 km"}).mission
    still = {"communication.distance": "99 km", "channel.turbulence": None}
    assert ground_file(tmp_path, typed, still).mission


def test_what_is_refused_at_one_value_is_taken_at_the_next(tmp_path):
    assert ground_file(tmp_path, SLOT).mission.path.elevation_rad > 20.0 * deg
    assert ground_file(tmp_path, LOW, {"orbit.geo.mask": "15 deg"}).mission.path.elevation_rad > 15.0 * deg
    assert ground_file(tmp_path, {"channel.turbulence.corrected_modes": 3}).mission
    swapped = {"channel.turbulence.wind_rms": None, "channel.turbulence.wind": WIND}
    assert ground_file(tmp_path, swapped).mission.channel.turbulence.wind.jet_m_s == 30.0
    free = {**FREE, "attitude": "free"}
    del free["boresight"], free["field_of_regard"]
    assert ground_file(tmp_path, {"orbit.geo.limits": free}).mission.orbit.station == "geo"
    whole = {"channel": {"zenith_transmission": 0.8}}
    assert ground_file(tmp_path, whole).mission.channel.turbulence is None
    far = {**TYPED, "channel.altitude": None, "communication.distance": "1000 km", "answer.distance": "900 km"}
    m = ground_file(tmp_path, far).mission
    assert (m.range_m(m.communication), m.range_m(m.answer)) == (1e6, 9e5)
    assert m.path.satellite_radius_m is None


def test_a_file_without_a_station_reads_as_it_did(tmp_path):
    m = link_file(tmp_path).mission
    assert m.path is None and Shared.of(m).sky is None and m.orbit.station == ""
    assert m.range_m(m.communication) == m.communication.distance_m == 42000e3
    assert Shared.of(m).clear_sky_db(1.55e-6) == 0.0
    sky = {"channel": {"zenith_transmission": 0.9, "elevation": "40 deg"}}
    m = link_file(tmp_path, sky).mission
    assert (m.path.station, m.path.satellite_radius_m, m.path.height_m) == ("", None, 0.0)
    assert m.range_m(m.communication) == 42000e3
    mass = 1.0 / (math.sin(40.0 * deg) + 0.50572 * 46.07995**-1.6364)  # Kasten and Young 1989
    for wavelength in (0.5e-6, 1.55e-6):
        assert Shared.of(m).clear_sky_db(wavelength) == pytest.approx(-10.0 * math.log10(0.9) * mass, rel=1e-6)
    (fault,) = faults(written(tmp_path, data_with({"communication.distance": None})))
    assert (fault.key, fault.reason) == ("communication.distance", "is missing")
    assert 'distance = "42000 km" would do' in fault.expected


@pytest.mark.promise("link-109")
def test_an_elevation_typed_beside_orbits_that_both_fly_is_doubted_with_the_range_of_the_lower(tmp_path):
    flying = {"orbit.geo": {"kind": "geostationary", "longitude": "0 deg"}, "operations": None}
    typed = {"channel.elevation": "20 deg", "channel.station": "geo", "channel.height": "0 m"}
    far = {"communication.distance": "900 km", "answer.distance": "900 km"}
    doubt = ground_file(tmp_path, flying, typed, far).mission.path.doubt
    said = "elevation and distance are typed beside the table orbit, in which both terminals fly"
    assert doubt == f"{said}: from 500 km up the range at 20 deg is 1193 km"
    low = {"orbit.leo": {"kind": "elements", "file": "a.tle"}}
    assert ground_file(tmp_path, flying, typed, far, low).mission.path.doubt == said
    assert ground_file(tmp_path).mission.path.doubt == ""


@pytest.mark.promise("link-110")
def test_turbulence_takes_the_values_of_its_file(tmp_path):
    table = ground_file(tmp_path).mission.channel.turbulence
    assert isinstance(table, TurbulenceTable)
    assert (table.ground_strength, table.wind_rms_m_s, table.corrected_modes) == (1.7e-14, 21.0, 0)
    assert set(TURBULENCE) == {"ground_strength", "wind_rms", "fades", "wander", "tilt", "corrected_modes"}
    assert Shared.of(ground_file(tmp_path).mission).sky.point_ahead_rad == pytest.approx(2.0 * 7500.0 / 299792458.0)


def end(kind, **values):
    return made(OrbitTable, kind=kind, **values)


TENERIFE = end("station", latitude_rad=28.3 * deg, longitude_rad=-16.5 * deg, height_m=2393.0, mask_rad=17.0 * deg)
CIRCLE = end("circular", altitude_m=625e3)


def fits(leo, geo, channel, communication=None, beacon=None, answer=None, outage=0.01):
    """What does not fit of two ends, the air between them, and the distances of the three links."""
    orbit = None if leo is None else made(Orbits, leo=leo, geo=geo)
    beams = [
        None if each is None else SimpleNamespace(distance_m=each or None)
        for each in (communication or 0.0, beacon, answer)
    ]
    return ground_fits(orbit, channel, *beams, SimpleNamespace(outage=outage))


ALL_OF_THE_AIR = {
    "winds of two kinds, and one mode": (
        lambda: made(TurbulenceTable, wind_rms_m_s=0.0, wind=0, corrected_modes=1).problems(),
        """
        wind_rms stands beside the table wind, of which it follows: expected one of the two removed; corrected_modes
        is 1: piston, or a tilt about one axis: expected 0 without adaptive optics, 3 for tip and tilt, or more
        """,
    ),
    "no wind, and a tilt about one axis": (
        lambda: made(TurbulenceTable, corrected_modes=2).problems(),
        """
        wind_rms is missing, and so is the table wind: expected wind_rms = "21 m/s" would do; corrected_modes is 2:
        piston, or a tilt about one axis: expected 0 without adaptive optics, 3 for tip and tilt, or more
        """,
    ),
    "a transmission beside all that it follows from": (
        lambda: made(
            Channel, zenith_transmission=0.9, aerosol_depth=0.0, angstrom_exponent=0.0, absorption_db=0.0
        ).problems(),
        """
        aerosol_depth stands beside zenith_transmission, which holds it: expected one of the two removed;
        angstrom_exponent stands beside zenith_transmission, which holds it: expected one of the two removed;
        absorption stands beside zenith_transmission, which holds it: expected one of the two removed
        """,
    ),
    "no transmission": (
        lambda: made(Channel).problems(),
        """
        zenith_transmission is missing, and so is what it follows from: expected zenith_transmission = 0.9 would do,
        or aerosol_depth, angstrom_exponent and absorption
        """,
    ),
    "a transmission of haze alone": (
        lambda: made(Channel, aerosol_depth=0.0).problems(),
        """
        angstrom_exponent is missing, and the transmission follows from it: expected angstrom_exponent = 1.3 would
        do, or zenith_transmission in place of all; absorption is missing, and the transmission follows from it:
        expected absorption = "0.1 dB" would do, or zenith_transmission in place of all
        """,
    ),
    "a transmission of absorption alone": (
        lambda: made(Channel, absorption_db=0.0).problems(),
        """
        aerosol_depth is missing, and the transmission follows from it: expected aerosol_depth = 0.1 would do, or
        zenith_transmission in place of all; angstrom_exponent is missing, and the transmission follows from it:
        expected angstrom_exponent = 1.3 would do, or zenith_transmission in place of all
        """,
    ),
    "a station without air": (
        lambda: fits(CIRCLE, TENERIFE, None, outage=None),
        """
        channel is missing, and orbit.geo is of kind "station": its links cross the air: expected a table such as
        [channel] with zenith_transmission = 0.9
        """,
    ),
    "a station above a satellite whose air says all of it again": (
        lambda: fits(
            CIRCLE,
            TENERIFE,
            made(Channel, elevation_rad=0.5, station="leo", height_m=0.0, altitude_m=6e5),
            communication=9e5,
            answer=8e5,
        ),
        """
        channel.elevation stands beside orbit.geo.mask, of which it follows: expected this line removed;
        channel.station stands beside orbit.geo, of which it follows: expected this line removed; channel.height
        stands beside orbit.geo, of which it follows: expected this line removed; channel.altitude stands beside
        orbit.leo, of which it follows: expected this line removed; communication.distance stands beside
        orbit.geo.mask and orbit.leo.altitude, of which a range of 1581 km follows: expected no distance;
        answer.distance stands beside orbit.geo.mask and orbit.leo.altitude, of which a range of 1581 km follows:
        expected no distance
        """,
    ),
    "a station below elements without an altitude": (
        lambda: fits(TENERIFE, end("ephemeris"), made(Channel, turbulence=0), beacon=9e5, outage=None),
        """
        channel.altitude is missing, and orbit.geo of kind "ephemeris" does not say it: expected altitude = "500 km"
        would do: the largest over the station; requirement.outage is missing, and the margin under
        channel.turbulence is the one that is kept but for it: expected a share of the time, outage = 0.01 for 1 %
        """,
    ),
    "turbulence that reaches beyond a distance, and no outage": (
        lambda: fits(
            None,
            None,
            made(Channel, turbulence=1, elevation_rad=0.5, station="geo", height_m=0.0),
            communication=99e3,
            beacon=1e5,
            answer=0.0,
            outage=None,
        ),
        """
        requirement.outage is missing, and the margin under channel.turbulence is the one that is kept but for it:
        expected a share of the time, outage = 0.01 for 1 %; communication.distance is below 100 km, up to which the
        air of channel.turbulence reaches: expected distance = "1000 km" would do; answer.distance is missing:
        expected distance = "42000 km" would do
        """,
    ),
    "turbulence of no place": (
        lambda: fits(None, None, made(Channel, turbulence=1)),
        """
        channel.elevation is missing, and no station in the table orbit says it: expected elevation = "30 deg" would
        do; channel.station is missing, and no station in the table orbit says it: expected station = "geo" would
        do; channel.height is missing, and no station in the table orbit says it: expected height = "0 m" would do;
        communication.distance is missing: expected distance = "42000 km" would do
        """,
    ),
    "haze of no height": (
        lambda: fits(None, None, made(Channel, aerosol_depth=0.1, elevation_rad=0.5), communication=1e6, answer=0.0),
        """
        channel.height is missing, and no station in the table orbit says it: expected height = "0 m" would do;
        answer.distance is missing: expected distance = "42000 km" would do
        """,
    ),
    "distances beside an elevation and an altitude": (
        lambda: fits(
            None,
            None,
            made(Channel, elevation_rad=25.0 * deg, altitude_m=7.5e5, height_m=1250.0),
            communication=1e6,
            beacon=0.0,
            answer=2e6,
        ),
        """
        communication.distance stands beside channel.elevation and channel.altitude, of which a range of 1473 km
        follows: expected no distance; answer.distance stands beside channel.elevation and channel.altitude, of
        which a range of 1473 km follows: expected no distance
        """,
    ),
    "a slot below the horizon": (
        lambda: fits(end("geostationary", longitude_rad=150.0 * deg), TENERIFE, made(Channel), beacon=4e7),
        """
        orbit.leo.longitude leaves the satellite at an elevation of -62.83 deg over the station, below the horizon:
        expected a slot that the station sees, or another station
        """,
    ),
    "a slot below the mask": (
        lambda: fits(TENERIFE, end("geostationary", longitude_rad=-83.5 * deg), made(Channel), beacon=4e7),
        """
        orbit.geo.longitude leaves the satellite at an elevation of 11.61 deg over the station, below orbit.leo.mask
        of 17 deg: expected a slot that the station sees, or another station; beacon.distance stands beside
        orbit.leo.latitude and orbit.geo.longitude, of which a range of 40420 km follows: expected no distance
        """,
    ),
    "a distance beside a slot": (
        lambda: fits(TENERIFE, end("geostationary", longitude_rad=-43.5 * deg), made(Channel), communication=4e7),
        """
        communication.distance stands beside orbit.leo.latitude and orbit.geo.longitude, of which a range of 37370
        km follows: expected no distance
        """,
    ),
}


@pytest.mark.parametrize("what", ALL_OF_THE_AIR)
def test_all_that_does_not_fit_about_the_air_is_told_in_full(what):
    problems, words = ALL_OF_THE_AIR[what]
    assert told(problems()) == one_line(words)


NEAR_TENERIFE = (0.296706, 2393.0, 6375754.79)
PATHS = {
    "a circle below": (CIRCLE, TENERIFE, {}, "geo", *NEAR_TENERIFE, 7003137.0, "orbit.geo.mask orbit.leo.altitude"),
    "an ellipse by its apogee": (
        TENERIFE,
        end("keplerian", semi_major_axis_m=7.25e6, eccentricity=0.0625),
        {},
        *("leo", *NEAR_TENERIFE, 7703125.0, "orbit.leo.mask orbit.geo.semi_major_axis"),
    ),
    "an ellipse that is a circle": (
        TENERIFE,
        end("keplerian", semi_major_axis_m=7.25e6),
        {},
        *("leo", *NEAR_TENERIFE, 7.25e6, "orbit.leo.mask orbit.geo.semi_major_axis"),
    ),
    "elements with the altitude of the air": (
        end("elements"),
        TENERIFE,
        {"altitude_m": 5.5e5},
        *("geo", *NEAR_TENERIFE, 6928137.0, "orbit.geo.mask channel.altitude"),
    ),
    "elements of any altitude": (
        end("elements"),
        TENERIFE,
        {},
        *("geo", *NEAR_TENERIFE, None, "orbit.geo.mask channel.altitude"),
    ),
    "a slot in the west": (
        end("geostationary", longitude_rad=-43.5 * deg),
        TENERIFE,
        {},
        *("geo", 0.796149, *NEAR_TENERIFE[1:], 42164169.6, "orbit.geo.latitude orbit.leo.longitude"),
    ),
    "a slot in the east": (
        TENERIFE,
        end("geostationary", longitude_rad=12.0 * deg),
        {},
        *("leo", 0.776948, *NEAR_TENERIFE[1:], 42164169.6, "orbit.leo.latitude orbit.geo.longitude"),
    ),
    "all typed": (
        None,
        None,
        {"elevation_rad": 0.5, "station": "leo", "height_m": 1250.0, "altitude_m": 7.5e5},
        *("leo", 0.5, 1250.0, 6379387.0, 7128137.0, "channel.elevation channel.altitude"),
    ),
    "an elevation": (None, None, {"elevation_rad": 0.5}, "", 0.5, 0.0, 6378137.0, None, "channel.elevation"),
}


@pytest.mark.parametrize("what", PATHS)
def test_a_path_has_its_end_its_elevation_its_radii_and_their_sources(what):
    leo, geo, channel, station, elevation, height, own, radius, sources = PATHS[what]
    path = path_of(None if leo is None else made(Orbits, leo=leo, geo=geo), made(Channel, **channel))
    assert (path.station, path.doubt, " ".join(path.sources)) == (station, "", sources)
    found = (path.elevation_rad, path.height_m, path.station_radius_m, path.satellite_radius_m)
    for each, wanted in zip(found, (elevation, height, own, radius), strict=True):
        assert each is None if wanted is None else each == pytest.approx(wanted, rel=1e-6)


@pytest.mark.parametrize(
    ("geo", "altitude", "doubt"),
    [
        (CIRCLE, None, ""),
        (end("elements"), None, ": from 625 km up the range at 28.65 deg is 1149 km"),
        (end("elements"), 8e5, ": from 625 km up the range at 28.65 deg is 1149 km"),
    ],
)
def test_an_elevation_beside_orbits_is_doubted_with_the_height_of_the_lower_end(geo, altitude, doubt):
    """The lower end is the first one, whatever the air says of an altitude."""
    leo = CIRCLE if doubt else end("elements")
    channel = made(Channel, elevation_rad=0.5, height_m=1250.0, altitude_m=altitude)
    said = "elevation and distance are typed beside the table orbit, in which both terminals fly"
    assert path_of(made(Orbits, leo=leo, geo=geo), channel).doubt == said + doubt


def test_there_is_no_path_without_air_an_elevation_or_a_whole_station():
    assert path_of(made(Orbits, leo=CIRCLE, geo=TENERIFE), None) is None
    assert path_of(None, made(Channel, altitude_m=1e6)) is None
    for lacking in ("latitude_rad", "height_m", "mask_rad"):
        site = TENERIFE.model_copy(update={lacking: None})
        assert path_of(made(Orbits, leo=CIRCLE, geo=site), made(Channel)) is None


def test_range_elevation_and_altitude_of_a_station_above_the_sea_are_one_triangle():
    path = GroundPath("leo", 0.375, 2500.0, 6.38e6, 7.25e6, ("a",))
    far = path.range_at(0.5)
    assert far == pytest.approx(1547126.48, rel=1e-6)
    assert math.hypot(far * math.cos(0.5), 6.38e6 + far * math.sin(0.5)) == pytest.approx(7.25e6, rel=1e-12)
    assert path.elevation_at(far) == pytest.approx(0.5, rel=1e-9)
    assert path.elevation_at(8.0e5) == math.pi / 2  # nearer than the zenith
    assert path.altitude_of(1.25e6) == pytest.approx(557924.33, rel=1e-6)
    assert path.at(0.625) == GroundPath("leo", 0.625, 2500.0, 6.38e6, 7.25e6, ("a",))
    assert range_of(SimpleNamespace(distance_m=7e5), path) == 7e5
    assert range_of(SimpleNamespace(distance_m=None), path) == path.range_at(0.375)


def test_a_range_that_no_elevation_has_is_that_of_the_zenith_or_of_the_nadir():
    path = GroundPath("leo", 0.5, 0.0, 6.4e6, 7.0e6, ("channel.elevation",))
    assert path.elevation_at(path.range_at(0.3)) == pytest.approx(0.3, rel=1e-9)
    assert path.elevation_at(0.5e6) == path.elevation_at(1e3) == math.pi / 2.0
    assert path.elevation_at(13.5e6) == path.elevation_at(1e9) == -math.pi / 2.0
    # up from the zenith of the station the altitude is the range
    assert path.at(math.pi / 2.0).altitude_of(0.6e6) == pytest.approx(7.0e6 - 6378137.0)
