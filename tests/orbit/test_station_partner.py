"""A station as one end of a link: its contacts are the passes above its mask, whichever end it is."""

import math
from pathlib import Path

import numpy as np
import pytest

from microrad import orbit
from microrad.mission.file import load_link
from microrad.mission.presets import preset_text
from microrad.orbit.day import geometry
from microrad.orbit.visibility.contacts import contacts, contacts_with_each, hidden_by
from microrad.orbit.visibility.limits import UNLIMITED, Terminal

DAY_S = (0.0, 86400.0)


@pytest.fixture(scope="module")
def pair(tmp_path_factory):
    path = tmp_path_factory.mktemp("station") / "ground.toml"
    path.write_text(preset_text("ground-downlink"), encoding="utf-8")
    m = load_link(path).mission
    return orbit.pair(m.orbit, m.terminals, Path())


@pytest.mark.promise("link-115")
def test_contacts_with_a_station_are_its_passes(pair):
    found = contacts(pair.leo, pair.geo, pair.earth, pair.epoch, DAY_S)
    passes = orbit.passes(pair.leo.orbit, pair.geo.orbit.station, pair.epoch, DAY_S)
    assert len(found) == len(passes) == 2
    for contact, each in zip(found, passes, strict=True):
        assert (contact.begins, contact.ends) == (each.begins, each.ends) == ("elevation mask of Tenerife",) * 2
        assert contact.start_s == pytest.approx(each.start_s, abs=1e-5)
        assert contact.end_s == pytest.approx(each.end_s, abs=1e-5)


def test_the_two_ends_of_a_link_to_a_station_may_be_swapped(pair):
    there, back = (
        contacts(*both, pair.earth, pair.epoch, DAY_S) for both in ((pair.leo, pair.geo), (pair.geo, pair.leo))
    )
    assert there == back and there


def test_a_station_among_relays_keeps_its_mask_and_they_the_earth(pair):
    slot = Terminal(orbit.GeostationarySlot("slot", pair.epoch, math.radians(10.0)), UNLIMITED, "slot")
    both = contacts_with_each(pair.leo, (slot, pair.geo), pair.earth, pair.epoch, DAY_S)
    alone = [contacts(pair.leo, each, pair.earth, pair.epoch, DAY_S) for each in (slot, pair.geo)]
    for found, own in zip(both, alone, strict=True):
        assert [(c.begins, c.ends) for c in found] == [(c.begins, c.ends) for c in own]
        assert [c.start_s for c in found] == pytest.approx([c.start_s for c in own], abs=1e-5)
    assert {hidden_by(pair.leo, each) for each in (slot, pair.geo)} == {"Earth", "elevation mask of Tenerife"}


def test_the_elevation_at_an_end_of_a_contact_is_the_mask(pair):
    site = pair.geo.orbit.station
    for contact in contacts(pair.leo, pair.geo, pair.earth, pair.epoch, DAY_S):
        time = np.array([contact.start_s, (contact.start_s + contact.end_s) / 2.0, contact.end_s])
        elevation = orbit.earth.figure.elevation_rad(site, pair.epoch, time, pair.leo.orbit.states(time).position_m)
        assert elevation[[0, 2]] == pytest.approx(site.mask_rad, abs=1e-8)
        assert elevation[1] > site.mask_rad


def test_what_the_partner_is_called_follows_from_the_end_on_the_ground(pair):
    seen = geometry.view(pair, 1.55e-6)
    assert seen.partner == "station"
    assert seen.rises == len(seen.encounters) == 2
    turned = orbit.Pair(pair.epoch, pair.earth, pair.geo, pair.leo, pair.span_s, pair.tail_s)
    assert geometry.view(turned, 1.55e-6).partner == "satellite"


def test_a_station_moves_as_the_earth_turns(pair):
    time = np.array([0.0, 86164.0905])
    states = pair.geo.orbit.states(time)
    speed = np.linalg.norm(states.velocity_m_s, axis=0)
    assert speed == pytest.approx(7.292e-5 * np.linalg.norm(states.position_m[:2], axis=0), rel=1e-4)
    assert states.position_m[:, 0] == pytest.approx(states.position_m[:, 1], abs=5.0)
    assert pair.geo.orbit.name == "Tenerife"
