"""The ground track over the map: when a relay has an outline and when its own track, and what the outlines mean."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from day_files import ALONE, EPOCH, KEPLERIAN, day_file, ephemeris
from microrad import orbit
from microrad.link import study as link_study
from microrad.mission.file import load_link
from microrad.mission.presets import preset_text
from microrad.orbit import EARTH_RADIUS_M, GEOSTATIONARY_RADIUS_M
from microrad.orbit import day as day_study
from microrad.orbit.day import NOTHING, Numbers, Swing
from microrad.orbit.day.ground_track import LONGEST_S, STEP_S, _moves, _outline, ground_track
from microrad.report.day.figures import day_figures
from optical_files import optical

SIX_HOURS = {"orbit.duration": "6 h", **ALONE}
HIGH = {"kind": "circular", "altitude": "8000 km", "inclination": "30 deg", "node": "0 deg", "phase": "0 deg"}
HIGH |= {"gravity": "two-body"}
FREE = {"orbit.geo.limits": None, "orbit.leo.limits": None}  # nothing but the Earth hides the relay
GRAZING_M = EARTH_RADIUS_M + 100e3


def at_rest(inclination_deg):
    """An orbit of one turn in a sidereal day: over the equator at the epoch, furthest off by its inclination."""
    radius = f"{GEOSTATIONARY_RADIUS_M / 1e3} km"
    high = {**KEPLERIAN, "semi_major_axis": radius, "eccentricity": 0.0, "inclination": f"{inclination_deg} deg"}
    return {"orbit.geo": {**high, "argument_of_perigee": "0 deg", "gravity": "two-body"}}


def stretched(eccentricity):
    return {"orbit.leo": {**KEPLERIAN, "eccentricity": eccentricity}}


@pytest.fixture
def track_of(tmp_path):
    """Ground track and pair of a mission without contacts, by changes of the mission."""

    def made(*changes):
        m = day_file(tmp_path, ALONE, *changes).mission
        pair = orbit.pair(m.orbit, m.terminals, tmp_path)
        seen = SimpleNamespace(pair=pair, duration_s=pair.span_s[1])
        return ground_track(seen, (), m.operations.downlink), pair

    return made


def unit(latitude, longitude):
    return np.stack([np.cos(latitude) * np.cos(longitude), np.cos(latitude) * np.sin(longitude), np.sin(latitude)])


def places(outline):
    return unit(outline.latitude_rad, outline.longitude_rad)


def around(outline):
    return unit(outline.around_latitude_rad, outline.around_longitude_rad)


def mean_radius_m(track, pair):
    """Mean distance of the satellite from the centre of a round Earth."""
    turned = pair.epoch.earth_rotation_rad(track.time_s)
    return EARTH_RADIUS_M + np.mean(orbit.subpoint(pair.leo.orbit.states(track.time_s).position_m, turned).height_m)


def test_from_the_outline_of_a_slot_the_line_of_sight_grazes_the_earth(track_of):
    track, pair = track_of()
    relay = places(track.relay) * GEOSTATIONARY_RADIUS_M
    assert relay.shape == (3, 1)
    low = around(track.relay) * mean_radius_m(track, pair)
    along = low - relay
    nearest = relay - along * np.sum(relay * along, axis=0) / np.sum(along**2, axis=0)
    assert np.linalg.norm(nearest, axis=0) == pytest.approx(np.full(low.shape[1], GRAZING_M), abs=10.0)
    assert np.all(np.sum(low * relay, axis=0) < 0.0)  # beyond the limb, not before it
    assert around(track.relay)[:, 0] == pytest.approx(around(track.relay)[:, -1])


def test_an_outline_across_the_date_line_comes_in_from_the_other_side():
    found = _outline("relay", 0.0, math.radians(160.0), math.radians(60.0))
    longitude = found.around_longitude_rad
    assert np.all((-math.pi <= longitude) & (longitude < math.pi))
    assert np.count_nonzero(np.abs(np.diff(longitude)) > math.pi) == 2
    east = np.degrees(longitude) % 360.0
    assert (east.min(), east.max()) == (pytest.approx(100.0, abs=0.1), pytest.approx(220.0, abs=0.1))


def test_from_the_outline_of_a_station_the_satellite_stands_at_its_mask(track_of):
    track, pair = track_of()
    (kiruna,) = track.stations
    up = places(kiruna)
    line = around(kiruna) * mean_radius_m(track, pair) - up * EARTH_RADIUS_M
    elevation = np.arcsin(np.sum(line * up, axis=0) / np.linalg.norm(line, axis=0))
    assert np.degrees(elevation) == pytest.approx(np.full(elevation.size, 5.0), abs=1e-6)


def test_the_satellite_sees_the_relay_outside_the_shade_and_not_in_it(track_of):
    track, pair = track_of(FREE)
    contacts = orbit.contacts(pair.leo, pair.geo, pair.earth, pair.epoch, pair.span_s)
    seen = np.any([(c.start_s <= track.time_s) & (track.time_s <= c.end_s) for c in contacts], axis=0)
    relay, own = places(track.relay), unit(track.latitude_rad, track.longitude_rad)
    reach = math.acos(float(np.sum(relay[:, 0] * around(track.relay)[:, 0])))
    inside = reach - np.arccos(np.sum(relay * own, axis=0))
    clear = np.abs(inside) > math.radians(1.0)  # the Earth is not round
    assert np.mean(clear) > 0.9
    assert 100 < np.sum(seen) < seen.size - 100
    np.testing.assert_array_equal(seen[clear], inside[clear] > 0.0)


@pytest.mark.parametrize(("inclination_deg", "stands"), [(0.0, True), (0.95, True), (1.05, False), (8.0, False)])
def test_a_relay_stands_still_within_a_degree(track_of, inclination_deg, stands):
    track, _ = track_of(at_rest(inclination_deg))
    assert (track.relay.around_latitude_rad.size > 0) == stands
    assert track.relay.latitude_rad.size == (1 if stands else track.time_s.size)
    if not stands:
        most = np.degrees(np.max(np.abs(track.relay.latitude_rad)))
        assert most == pytest.approx(inclination_deg, abs=0.1)  # geodetic


def test_a_relay_from_a_file_stands_still_too(track_of, tmp_path):
    slot = orbit.GeostationarySlot("EXAMPLE 1", orbit.Epoch(EPOCH), math.radians(100.0))
    (tmp_path / "relay.oem").write_text(ephemeris(slot, np.arange(0.0, 21601.0, 600.0)), encoding="utf-8")
    track, _ = track_of(SIX_HOURS, {"orbit.geo": {"kind": "ephemeris", "file": "relay.oem"}})
    assert np.degrees(track.relay.longitude_rad) == pytest.approx([100.0], abs=1e-3)
    assert track.relay.around_latitude_rad.size > 0


def test_a_relay_that_moves_has_its_own_track(track_of):
    track, pair = track_of({"orbit.geo": HIGH})
    assert track.relay.around_latitude_rad.size == track.relay.around_longitude_rad.size == 0
    position = pair.geo.orbit.states(track.time_s).position_m
    turned = pair.epoch.earth_rotation_rad(track.time_s)
    by_hand = np.arctan2(position[1], position[0]) - turned
    assert np.cos(track.relay.longitude_rad - by_hand) == pytest.approx(np.ones(by_hand.size))
    sine = position[2] / np.linalg.norm(position, axis=0)
    assert np.sin(track.relay.latitude_rad) == pytest.approx(sine, abs=4e-3)  # geodetic
    assert track.stations[0].around_latitude_rad.size > 0


@pytest.mark.parametrize(("eccentricity", "near"), [(0.02, True), (0.03, False)])
def test_an_outline_holds_for_one_height_only(track_of, eccentricity, near):
    track, _ = track_of(stretched(eccentricity))
    for each in (track.relay, *track.stations):
        assert (each.around_latitude_rad.size > 0) == (each.around_longitude_rad.size > 0) == near
        assert each.latitude_rad.size == each.longitude_rad.size == 1


def test_a_track_is_of_a_day_at_most(track_of):
    track, _ = track_of({"orbit.duration": "30 h"})
    assert track.time_s[-1] == LONGEST_S - STEP_S


# ------------------------------------------------------------------------------------------------ from a day
@pytest.fixture
def drawn(tmp_path, monkeypatch):
    """The figures of six hours with one assumption changed, by changes of the mission."""
    side = Numbers(1e12, 1e11, 10.0, 100.0)
    both = side, side, side
    swings = [Swing("attitude", "nadir", NOTHING, *both), Swing("rate", NOTHING, "2 bit/s", *both)]
    swings += [Swing("mask", "0 deg", "10 deg", *both), Swing("altitude", NOTHING, NOTHING, *both)]
    monkeypatch.setattr(day_study, "swings", lambda *given: tuple(swings))

    def draw(*changes):
        day = day_study.run_day_study(
            link_study.run_link_study(day_file(tmp_path, SIX_HOURS, {"operations.runs": 1}, *changes))
        )
        return day, {figure.name: figure for figure in day_figures(day)}

    return draw


@pytest.mark.parametrize(
    ("given", "number"), [({"operations.contact.number": 3}, 3), ({"operations.contact": None}, 1)]
)
def test_the_figures_say_which_contact_and_only_what_is_drawn(drawn, given, number):
    day, figures = drawn(given, {"orbit.geo": HIGH})
    along = figures["along-contact"]
    assert along.title == f"Along contact {number}"
    contact = day.view.encounters[number - 1].contact
    assert day.view.pair.epoch.utc(contact.start_s)[:19].replace("T", " ") + " UTC" in along.caption
    assert along.columns["time since rise (s)"][-1] == pytest.approx(contact.duration_s)
    name = day.view.pair.geo.name
    columns = figures["world-map"].columns
    assert columns[f"{name}, latitude (deg)"].size == columns["track, latitude (deg)"].size
    assert "The relay moves" in figures["world-map"].caption
    assert "shaded" not in figures["world-map"].caption
    assert "first" not in figures["world-map"].caption


def test_a_side_that_is_as_it_is_has_no_words(drawn):
    _, figures = drawn()
    labels = [heading.removesuffix(", lower") for heading in figures["assumptions"].columns if ", lower" in heading]
    assert labels == ["attitude: nadir", "rate: 2 bit/s", "mask: 0 deg / 10 deg", "altitude"]


def test_the_map_of_more_than_a_day_says_so(drawn):
    _, figures = drawn({"orbit.duration": "30 h"})
    assert "in the first 24 h of the span" in figures["world-map"].caption


# ------------------------------------------------------------------------------------- two of each, unlike each other
def way_of(name, *spans):
    return SimpleNamespace(name=name, contacts=[orbit.Contact(*span, "", "") for span in spans])


OTHER = {"latitude": "-33.5 deg", "longitude": "-70.25 deg", "height": "700 m", "mask": "12 deg"}


def test_a_track_has_each_way_and_each_station_in_its_place(tmp_path):
    north = "operations.downlink.stations.other"
    m = day_file(tmp_path, ALONE, {"orbit.duration": "3 h", north: OTHER}, optical(0.5, data_rate="1 Gbit/s")).mission
    pair = orbit.pair(m.orbit, m.terminals, tmp_path)
    ways = way_of("relay", (60.0, 90.0), (95.0, 119.9), (10770.0, 99999.0)), way_of("direct"), way_of("3", (-9.0, 0.0))
    seen = SimpleNamespace(pair=pair, duration_s=pair.span_s[1])
    track = ground_track(seen, ways, m.operations.downlink, m.operations.optical)
    assert track.time_s.tolist() == [30.0 * k for k in range(360)]
    assert {name: np.flatnonzero(there).tolist() for name, there in track.open.items()} == {
        "relay": [2, 3, 359], "direct": [], "3": [0]
    }  # fmt: skip
    assert [s.name for s in track.stations] == ["kiruna", "other", "kiruna", "tromso", "tenerife"]
    places = [math.degrees(x[0]) for s in track.stations for x in (s.latitude_rad, s.longitude_rad)]
    assert places == pytest.approx([67.85713, 20.96433, -33.5, -70.25, 67.86, 20.96, 69.66, 18.94, 28.3, -16.5])
    only = ground_track(seen, (), None, m.operations.optical)
    assert ([s.name for s in only.stations], only.open) == (["kiruna", "tromso", "tenerife"], {})
    height = mean_radius_m(track, pair)
    for each, mask in zip(track.stations, (5.0, 12.0, 5.0, 5.0, 10.0), strict=True):
        up = unit(each.latitude_rad, each.longitude_rad)
        line = around(each) * height - up * EARTH_RADIUS_M
        elevation = np.arcsin(np.sum(line * up, axis=0) / np.linalg.norm(line, axis=0))
        assert np.degrees(elevation) == pytest.approx(np.full(elevation.size, mask), abs=1e-6)


def test_the_track_of_a_link_to_a_station_has_it_first_whichever_end_it_is(tmp_path):
    (tmp_path / "ground.toml").write_text(preset_text("ground-downlink"), encoding="utf-8")
    m, heard = load_link(tmp_path / "ground.toml").mission, day_file(tmp_path, ALONE).mission.operations.downlink
    pair = orbit.pair(m.orbit, m.terminals, tmp_path)
    tracks = [
        ground_track(SimpleNamespace(pair=own, duration_s=7200.0), (), heard)
        for own in (pair, orbit.Pair(pair.epoch, pair.earth, pair.geo, pair.leo, pair.span_s, pair.tail_s))
    ]
    for track in tracks:
        assert ([s.name for s in track.stations], track.relay, track.time_s.size) == (["Tenerife", "kiruna"], None, 240)
        np.testing.assert_array_equal(track.latitude_rad, tracks[0].latitude_rad)
    assert np.ptp(tracks[0].latitude_rad) > 1.0


@pytest.mark.parametrize(("latitude", "longitude", "moves"), [
    ([60.0, 60.0], [10.0, 11.9], False), ([60.0, 60.0], [10.0, 12.1], True), ([0.0, 0.0], [-179.6, 179.6], False),
    ([0.0, 0.0], [0.0, 1.01], True), ([80.0, 80.9], [0.0, 2.4], False), ([80.0, 80.9], [0.0, 3.4], True),
    ([0.0, 0.6, -0.6], [5.0, 5.7, 4.3], False), ([0.0, 0.75, 0.0], [5.0, 5.7, 5.0], True),
    ([-70.0, -71.1], [3.0, 3.0], True),
])  # fmt: skip
def test_a_point_moves_by_more_than_a_degree_on_the_sphere(latitude, longitude, moves):
    assert _moves(np.radians(latitude), np.radians(longitude)) == moves
