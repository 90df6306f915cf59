"""Contacts with a station as an end of the link: against passes, a second by second count, and what they carry."""

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from ground_files import STILL, UP, ground_file
from microrad import link, orbit
from microrad.link import study as link_study
from microrad.orbit import Epoch, Station
from microrad.orbit import day as day_study
from microrad.orbit.day import PointingLoss, assumptions, flow, geometry
from microrad.orbit.day.ground_track import ground_track
from microrad.orbit.earth.figure import Earth, GroundSite
from microrad.orbit.propagation.analytic import GeostationarySlot, KeplerOrbit, circular
from microrad.orbit.visibility.contacts import coarse_step_s, contacts, contacts_with_each, passes
from microrad.orbit.visibility.limits import UNLIMITED, Terminal
from microrad.orbit.visibility.stations import StationRows, pass_spans
from microrad.report.day.figures import ground_map

DAY = (0.0, 86400.0)
EPOCH = Epoch("2026-03-20T12:00:00Z")
EARTH = Earth("oblate", 100e3)
deg = math.pi / 180.0
one_microsecond = 1e-6
TEIDE = Station("Teide", 28.3 * deg, -16.5 * deg, 2393.0, 20.0 * deg)
KIRUNA = Station("Kiruna", 67.9 * deg, 21.0 * deg, 400.0, 10.0 * deg)
SOUTH = Station("South", -75.0 * deg, 123.0 * deg, 3200.0, 35.0 * deg)
LOW = circular("LOW", EPOCH, 500e3, 97.4 * deg, 1.0, 2.0, True)
OVAL = KeplerOrbit("OVAL", EPOCH, 9000e3, 0.2, 63.4 * deg, 0.5, 1.0, 0.3, True)


def free(flying):
    return Terminal(flying, UNLIMITED, flying.name)


def site(station):
    return free(GroundSite(station, EPOCH))


def ends(found):
    return np.array([(c.start_s, c.end_s) for c in found]).reshape(-1, 2)


@pytest.mark.parametrize("flying", [LOW, OVAL])
@pytest.mark.parametrize("station", [TEIDE, KIRUNA, SOUTH])
@pytest.mark.promise("link-115")
def test_a_contact_with_a_station_is_a_pass_over_it(flying, station):
    found = contacts(free(flying), site(station), EARTH, EPOCH, DAY)
    over = passes(flying, station, EPOCH, DAY)
    assert len(found) == len(over) > 1
    assert np.abs(ends(found) - ends(over)).max() < one_microsecond
    mask = f"elevation mask of {station.name}"
    assert {c.begins for c in found} | {c.ends for c in found} == {mask}
    # the line of sight lies in the air that another satellite's must clear: the grazing height does not count
    assert found == contacts(free(flying), site(station), Earth("sphere", 0.0), EPOCH, DAY)


@pytest.mark.parametrize("station", [TEIDE, SOUTH])
def test_contacts_with_a_station_are_those_that_are_seen_second_by_second(station):
    """The station is put on the ellipsoid and turned with the Earth by hand, and its horizon by the plumb line."""
    time = np.arange(0.0, 43200.0) + 0.5
    square = (2.0 - 1.0 / 298.257223563) / 298.257223563
    level, rise = math.cos(station.latitude_rad), math.sin(station.latitude_rad)
    normal = 6378137.0 / math.sqrt(1.0 - square * rise**2)
    turned = EPOCH.earth_rotation_rad(time) + station.longitude_rad
    up = np.stack((level * np.cos(turned), level * np.sin(turned), np.full_like(turned, rise)))
    own = up * (normal + station.height_m) - np.array([[0.0], [0.0], [normal * square * rise]])
    line = LOW.states(time).position_m - own
    elevation = np.arcsin(np.sum(line * up, axis=0) / np.linalg.norm(line, axis=0))
    seen = elevation > station.mask_rad
    found = ends(contacts(free(LOW), site(station), EARTH, EPOCH, (0.0, 43200.0)))
    inside = np.searchsorted(found.ravel(), time) % 2 == 1
    assert np.sum(seen != inside) <= 1  # an end in the middle of a second
    assert seen.any() and not seen.all()


def test_a_station_at_either_end_has_the_same_contacts():
    one, other = free(LOW), site(KIRUNA)
    first, second = (contacts(*pair, EARTH, EPOCH, DAY) for pair in ((one, other), (other, one)))
    assert np.abs(ends(first) - ends(second)).max() < one_microsecond
    assert [(c.begins, c.ends) for c in first] == [(c.begins, c.ends) for c in second]


def test_a_station_among_relays_is_seen_above_its_mask_and_the_others_beside_the_earth():
    slot, second = GeostationarySlot("GEO", EPOCH, 0.3), circular("OTHER", EPOCH, 900e3, 1.0, 0.2, 0.1, False)
    relays = (free(slot), site(TEIDE), free(second), site(KIRUNA))
    together = contacts_with_each(free(LOW), relays, EARTH, EPOCH, DAY)
    for relay, found in zip(relays, together, strict=True):
        alone = contacts(free(LOW), relay, EARTH, EPOCH, DAY)
        assert np.abs(ends(found) - ends(alone)).max() < one_microsecond
        cause = f"elevation mask of {relay.name}" if isinstance(relay.orbit, GroundSite) else "Earth"
        said = {c.begins for c in found} | {c.ends for c in found}
        assert said - {"start of the span", "end of the span"} == {cause}
    # the other way round: a station with satellites as its relays
    flying = (free(LOW), free(OVAL))
    for relay, found in zip(flying, contacts_with_each(site(TEIDE), flying, EARTH, EPOCH, DAY), strict=True):
        over = passes(relay.orbit, TEIDE, EPOCH, DAY)
        assert np.abs(ends(found) - ends(over)).max() < one_microsecond


def test_a_geostationary_satellite_is_seen_all_the_time_or_never():
    near, hidden = (free(GeostationarySlot("GEO", EPOCH, each * deg)) for each in (-10.0, 100.0))
    (whole,) = contacts(near, site(TEIDE), EARTH, EPOCH, DAY)
    assert (whole.start_s, whole.end_s) == DAY
    assert (whole.begins, whole.ends) == ("start of the span", "end of the span")
    assert contacts(hidden, site(TEIDE), EARTH, EPOCH, DAY) == ()


def test_passes_without_any_limit_of_the_range_are_those_with_none_that_counts():
    rows, step = StationRows.of([TEIDE, KIRUNA], EPOCH), coarse_step_s(LOW, 0.0)
    plain = pass_spans(LOW, rows, DAY, step)
    for one, other in zip(plain, pass_spans(LOW, rows, DAY, step, [math.inf, math.inf]), strict=True):
        np.testing.assert_array_equal(one, other)
    near = pass_spans(LOW, rows, DAY, step, [1.0, math.inf])
    assert (len(near[0]), len(near[1])) == (0, len(plain[1])) and len(plain[0]) > 0
    assert pass_spans(LOW, StationRows.of([], EPOCH), DAY, step) == ()


def test_a_range_cuts_a_pass_short():
    whole = contacts(free(LOW), site(TEIDE), EARTH, EPOCH, DAY)
    (cut,) = contacts_with_each(free(LOW), (site(TEIDE),), EARTH, EPOCH, DAY, furthest_m=800e3)
    assert {c.begins for c in cut} == {"range"}
    assert 0.0 < sum(c.duration_s for c in cut) < 0.8 * sum(c.duration_s for c in whole)
    for c in cut:
        at = np.array([c.start_s, c.end_s])
        apart = LOW.states(at).position_m - TEIDE.position(EPOCH, at).position_m
        assert np.linalg.norm(apart, axis=0) == pytest.approx(800e3, abs=0.1)


# --------------------------------------------------------------------------------------------------------- a mission
@pytest.mark.parametrize("changes", [{}, UP])
def test_a_missions_contacts_are_passes_over_its_station(tmp_path, changes):
    m = ground_file(tmp_path, changes).mission
    pair = orbit.pair(m.orbit, m.terminals, tmp_path)
    ground, flying = (pair.geo, pair.leo) if not changes else (pair.leo, pair.geo)
    assert isinstance(ground.orbit, GroundSite)
    station = ground.orbit.station
    assert (station.latitude_rad, station.height_m) == (pytest.approx(28.3 * deg), 2393.0)
    assert (station.longitude_rad, station.mask_rad) == (pytest.approx(-16.5 * deg), pytest.approx(20.0 * deg))
    found = contacts(pair.leo, pair.geo, pair.earth, pair.epoch, DAY)
    assert np.abs(ends(found) - ends(passes(flying.orbit, station, pair.epoch, DAY))).max() < one_microsecond
    names = {c.begins for c in found}
    assert names == {f"elevation mask of {'satellite' if changes else 'Tenerife'}"}


@pytest.fixture(scope="module")
def day(tmp_path_factory):
    quick = {"channel.turbulence.fades": "log-normal", "answer": None}
    return day_study.run_day_study(
        link_study.run_link_study(ground_file(tmp_path_factory.mktemp("day"), quick, {"orbit.duration": "12 h"}))
    )


def test_a_day_carries_what_its_passes_last(day):
    """Each second of a pass is within reach at the mission's rate, since the link closes at its mask."""
    pair = day.view.pair
    over = passes(pair.leo.orbit, pair.geo.orbit.station, pair.epoch, (0.0, 43200.0))
    assert day.view.rises == len(over) >= 1
    lasts = [p.end_s - p.start_s for p in over]
    assert sum(e.contact.duration_s for e in day.view.encounters) == pytest.approx(sum(lasts), abs=1e-5)
    assert day.view.contact_s == pytest.approx(sum(lasts), abs=1e-5)
    assert day.relay.capacity_bit == pytest.approx(10e9 * sum(lasts), rel=1e-2)  # each second of it at the rate
    furthest = day.view.largest("range_most_m")
    # the mask is that of the budget, whose Earth is round: 0.16 deg of lean is at most 6 km there
    assert furthest == pytest.approx(day.data.range_m, abs=7e3)


@pytest.mark.promise("link-115")
def test_how_far_each_rate_reaches_is_where_it_has_lost_what_it_had_to_spare(tmp_path):
    m = ground_file(tmp_path, {"channel.turbulence.fades": "log-normal"}).mission
    data = link.of(m)
    wide = m.operations.model_copy(update={"rates_bit_s": (1e9, 10e9, 50e9, 120e9, 300e9, 700e9, 1e13)})
    found = flow.closings(wide, data, PointingLoss(data.added_db + 1.15, 0.01, "stated"))
    assert [each.rate_bit_s for each in found] == sorted(wide.rates_bit_s, reverse=True)
    nearest = data.shared.path.range_at(math.pi / 2.0)
    for each in found:
        spare = each.margin_db - wide.margin_db
        assert float(link.farther_db(data, each.largest_range_m)) == pytest.approx(spare, abs=1e-5)
    reach = {each.rate_bit_s: each.largest_range_m for each in found}
    assert reach[1e9] > reach[10e9] > data.range_m > reach[120e9] > reach[300e9] > nearest > reach[1e13]
    # of a rate that is 10 dB slower the reach is sqrt(10) times as far, behind the budget's elevation
    assert reach[1e9] / reach[10e9] == pytest.approx(math.sqrt(10.0), rel=1e-9)


@pytest.mark.parametrize("path", [None, SimpleNamespace(satellite_radius_m=None)])
@pytest.mark.parametrize(("spare_db", "reach_m"), [(-20.0, 4e6), (0.0, 4e7), (20.0, 4e8)])
def test_without_a_satellite_over_it_a_link_reaches_as_far_as_its_light_spreads(path, spare_db, reach_m):
    data = SimpleNamespace(range_m=4e7, shared=SimpleNamespace(path=path))
    assert flow._reach_m(data, spare_db) == pytest.approx(reach_m, rel=1e-12)


def test_what_a_link_on_the_ground_has_to_assume_is_said_of_its_own_ends(tmp_path):
    """The satellite of a station is not called a relay, and what stands on the ground has no attitude."""

    def changes_of(changes, **more):
        m = ground_file(tmp_path, changes, more).mission
        own = assumptions.Case(m.operations, m.orbit, link.of(m), PointingLoss(1.0, 0.01, "stated"))
        return {name: sides for name, *sides in assumptions._changes(own, None)}

    down, up = changes_of({}), changes_of(UP)
    assert "share of each contact that the station grants" in down
    assert "share of each contact that the satellite grants" in up
    (text, held), _ = down["attitude of the satellite"]
    assert text == "nadir, 60 deg about nadir"
    assert held.orbits.leo.limits.boresight == (0.0, 0.0, 1.0)
    assert not up.keys() & {"attitude of the satellite", "eclipse", "orbit altitude"}
    assert not (down.keys() | up.keys()) & {"grazing height", "time of acquisition"}


def test_in_still_air_the_reach_grows_with_the_elevation_too(tmp_path):
    data = link.of(ground_file(tmp_path, STILL).mission)
    path = data.shared.path
    for spare in (-6.0, -2.0, 3.0):
        reach = flow._reach_m(data, spare)
        air = data.shared.sky
        there = replace(air, path=path.at(max(path.elevation_at(reach), path.elevation_rad)))
        gained = air.clear_db(1.55e-6) - there.clear_db(1.55e-6)
        assert 20.0 * math.log10(reach / data.range_m) - gained == pytest.approx(spare, abs=2e-3)


@pytest.mark.parametrize("changes", [{}, UP])
def test_a_map_shows_the_satellites_track_and_the_station_but_no_relay(tmp_path, changes):
    file = ground_file(tmp_path, changes)
    m = file.mission
    seen = geometry.view(orbit.pair(m.orbit, m.terminals, tmp_path), m.communication.wavelength_m)
    track = ground_track(seen, (), None)
    assert track.relay is None
    (outline,) = track.stations
    assert outline.name == m.terminals.called(m.orbit.station)
    assert math.degrees(float(outline.latitude_rad[0])) == pytest.approx(28.3)
    assert np.ptp(np.degrees(track.latitude_rad)) > 160.0  # it goes over the poles
    figure = ground_map(SimpleNamespace(view=seen, ways=(), operations=None))
    explained = [each.label for each in figure.sheet.legend.only]
    assert "station, its horizon" in explained
    assert not any("relay" in label for label in explained)
