"""Contacts by one call: as those of the parts it is made of."""

import math
from types import SimpleNamespace

import pytest

from day_files import element_set
from microrad.orbit import UNLIMITED, Earth, Epoch, GeostationarySlot, OrbitError, Station, Terminal, contacts, passes
from microrad.orbit.between import find_contacts
from microrad.orbit.files.elements import read_elements
from microrad.orbit.propagation.mean_elements import Sgp4Orbit

START = "2026-03-20T12:00:00Z"


@pytest.fixture
def leo(tmp_path):
    path = tmp_path / "leo.tle"
    path.write_text(element_set(), encoding="utf-8")
    (elements,) = read_elements(str(path))
    return elements


def test_contacts_are_those_of_the_terminals(leo):
    epoch = Epoch(START)
    relay = GeostationarySlot("relay", epoch, math.radians(9.0))
    found = find_contacts(leo, relay, START, 86_400.0, grazing_height_m=50e3)
    sides = [Terminal(each, UNLIMITED, each.name) for each in (Sgp4Orbit(leo, epoch), relay)]
    assert found == contacts(*sides, Earth("oblate", 50e3), epoch, (0.0, 86_400.0))
    assert len(found) > 5
    assert sum(c.duration_s for c in find_contacts(leo, relay, START, 86_400.0)) < sum(c.duration_s for c in found)


def test_a_station_has_passes(leo):
    station = Station("north", math.radians(68.0), math.radians(21.0), 400.0, math.radians(10.0))
    found = find_contacts(leo, station, START, 86_400.0)
    assert found == passes(Sgp4Orbit(leo, Epoch(START)), station, Epoch(START), (0.0, 86_400.0))
    assert found


def test_a_search_that_cannot_be_is_refused(leo):
    with pytest.raises(OrbitError, match=r"a search of 0\.0 s finds nothing: give a duration above 0 s"):
        find_contacts(leo, leo, START, 0.0)
    with pytest.raises(OrbitError, match="2027"):
        find_contacts(leo, leo, "2027-03-20T12:00:00Z", 100.0)


def two(tmp_path):
    """Two element sets of epochs, planes and names unlike each other."""
    path = tmp_path / "two.tle"
    other = element_set(day=80.25, revolutions=13.4, eccentricity=12345, name="OTHER", number="70002", inclination=51.6)
    path.write_text(element_set() + other, encoding="utf-8")
    return read_elements(path)


@pytest.mark.parametrize("turned", [False, True])
def test_two_element_sets_are_each_flown_from_the_start(tmp_path, turned):
    first, second = two(tmp_path)[::-1] if turned else two(tmp_path)
    start = "2026-03-21T02:30:00.5Z"
    epoch = Epoch(start)
    orbits = Sgp4Orbit(first, epoch), Sgp4Orbit(second, epoch)
    found = find_contacts(first, second, start, 60_000.0)
    sides = [Terminal(each, UNLIMITED, each.name) for each in orbits]
    assert found == contacts(*sides, Earth("oblate", 100e3), epoch, (0.0, 60_000.0))
    assert (
        found == find_contacts(orbits[0], second, start, 60_000.0) == find_contacts(first, orbits[1], start, 60_000.0)
    )
    assert len(found) > 2 and found != find_contacts(first, second, "2026-03-21T03:00:00Z", 60_000.0)


@pytest.mark.parametrize(("duration_s", "words"), [
    (-5.0, "a search of -5.0 s finds nothing: give a duration above 0 s"),
    (math.nan, "a search of nan s finds nothing: give a duration above 0 s"),
    (15 * 86400.0, r"two\.tle, line 5 \(OTHER\): the elements are expired: their epoch is 2026-03-21T06:00:00Z"),
])  # fmt: skip
def test_a_search_says_which_of_two_satellites_ends_it(tmp_path, duration_s, words):
    first, second = two(tmp_path)
    slot = GeostationarySlot("relay", Epoch(START), 0.2)
    with pytest.raises(OrbitError, match=words):
        find_contacts(slot, second, START, duration_s)
    if duration_s > 0.0:
        with pytest.raises(OrbitError, match=r"two\.tle, line 2 \(EXAMPLE 1\): the elements are expired"):
            find_contacts(first, second, START, duration_s)


def test_an_orbit_of_another_epoch_is_refused_and_so_is_a_station_that_stands_first(leo):
    other = GeostationarySlot("relay", Epoch("2026-03-20T18:00:00Z"), math.radians(9.0))
    words = r"'relay' counts its times from 2026-03-20T18:00:00Z, and the search from 2026-03-20T12:00:00Z: start"
    for sides in ((leo, other), (other, leo)):
        with pytest.raises(OrbitError, match=words):
            find_contacts(*sides, START, 7200.0)
    station = Station("north", math.radians(68.0), math.radians(21.0), 400.0, math.radians(10.0))
    with pytest.raises(OrbitError, match="'north' stands first: give the satellite first"):
        find_contacts(station, leo, START, 7200.0)


def test_an_orbit_that_has_no_epoch_of_its_own_counts_from_the_start_on_either_side(leo):
    """All that an orbit must have are its name and its states."""
    relay = GeostationarySlot("relay", Epoch(START), math.radians(9.0))
    plain = SimpleNamespace(name="relay", states=relay.states)
    found = find_contacts(leo, relay, START, 14_400.0)
    assert len(found) > 1 and find_contacts(leo, plain, START, 14_400.0) == found
    assert find_contacts(plain, leo, START, 14_400.0) == found
