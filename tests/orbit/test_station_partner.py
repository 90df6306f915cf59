"""A station as one end of a link: what it is called, and how it moves."""

from pathlib import Path

import numpy as np
import pytest

from microrad import orbit
from microrad.mission.file import load_link
from microrad.mission.presets import preset_text
from microrad.orbit.day import geometry


@pytest.fixture(scope="module")
def pair(tmp_path_factory):
    path = tmp_path_factory.mktemp("station") / "ground.toml"
    path.write_text(preset_text("ground-downlink"), encoding="utf-8")
    m = load_link(path).mission
    return orbit.pair(m.orbit, m.terminals, Path())


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
