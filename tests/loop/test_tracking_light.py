"""The light on the tracking sensor, which whoever builds a loop hands in, and the noise that follows from it."""

import pytest

import budgets
from microrad import mirror
from microrad.link import tracking_light_w
from microrad.loop import controller_study
from microrad.mission.file import load_mission
from shipped import DEFAULT, SHIPPED


def noise_rad(file, power_w):
    return controller_study.scene(file, mirror.of(file.mission), power_w).loop.optical.noise_rad


def test_the_light_is_the_answers_unless_the_cell_states_it_or_the_noise_is_given(tmp_path):
    file, given = load_mission(DEFAULT), load_mission(SHIPPED)
    assert tracking_light_w(file) == budgets.answer(file.mission, file.sources).received_power_w > 0.0
    assert tracking_light_w(given) is None
    line = "[fine_pointing.optical_sensor.quad_cell]\n"
    text = DEFAULT.read_text(encoding="utf-8").replace(line, f'{line}received_power = "3 nW"\n')
    stated = load_mission(tmp_path / "m.toml", text=text)
    assert tracking_light_w(stated) == pytest.approx(3e-9, rel=1e-12)


@pytest.mark.promise("pointing-9")
def test_noise_follows_from_the_light_and_is_refused_without():
    file, given = load_mission(DEFAULT), load_mission(SHIPPED)
    assert noise_rad(file, 4e-9) < noise_rad(file, 1e-9)
    assert noise_rad(given, None) == noise_rad(given, 1.0) == 1e-6
    with pytest.raises(ValueError, match="noise of the tracking sensor follows from its light: give"):
        noise_rad(file, None)
