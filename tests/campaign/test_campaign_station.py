"""Keys that the loop of a mission depends on, where it stands on the ground."""

import pytest

from microrad.campaign.definition.keys import touches_loop
from microrad.mission.file import load_mission
from shipped import DEFAULT, SHIPPED
from station_files import station_file

OF_THE_AIR = (
    *("channel.turbulence.wind_rms", "channel.turbulence.ground_strength", "answer.wavelength"),
    *("terminals.leo_aperture", "orbit.leo.mask", "orbit.leo.height"),
)
OTHERS = ("answer.transmit_power", "terminals.geo_aperture", "orbit.geo.phase", "orbit.duration", "operations.store")


@pytest.mark.parametrize("key", OF_THE_AIR)
def test_what_moves_the_angle_of_arrival_is_of_the_loop_under_turbulence_alone(tmp_path, key):
    assert touches_loop(key, station_file(tmp_path).mission)
    assert not touches_loop(key, station_file(tmp_path, turbulence="").mission)
    assert not touches_loop(key, load_mission(SHIPPED).mission)


@pytest.mark.parametrize("key", OTHERS)
def test_what_does_not_is_not(tmp_path, key):
    assert not touches_loop(key, station_file(tmp_path).mission)


@pytest.mark.parametrize("key", ["channel.zenith_transmission", "orbit.geo.altitude"])
def test_the_light_on_a_quad_cell_is_weaker_through_more_air(tmp_path, key):
    assert touches_loop(key, station_file(tmp_path, turbulence="", of=DEFAULT).mission)
    assert not touches_loop(key, load_mission(DEFAULT).mission)
