"""Contacts by one call: as those of the parts it is made of."""

import math

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
