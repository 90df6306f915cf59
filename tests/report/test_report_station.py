"""What is said of a loop on the ground: the angle of arrival among its sources, its size and where it comes from."""

import json
import re
from dataclasses import replace

import pytest

from microrad.link import arrival_of
from microrad.loop import controller_study
from microrad.loop.disturbance import angle_of_arrival
from microrad.report.fine_pointing.data import fine_pointing_data
from microrad.report.fine_pointing.page import fine_pointing_view
from microrad.report.quantities import angle
from microrad.report.view import views_text
from scenes import scene_of
from station_files import TURBULENCE, station_file, station_text

SHORT = (
    ("runs = 64 ", "runs = 8 "),
    ('duration = "2 s" ', 'duration = "0.6 s" '),
    ('settle = "0.5 s"', 'settle = "0.2 s"'),
)


@pytest.fixture(scope="module")
def fine(tmp_path_factory):
    """Two controllers in that loop, without their sines, which nothing here looks at."""
    scene = scene_of(station_file(tmp_path_factory.mktemp("station"), *SHORT))
    designs = controller_study.design(scene, only=("PI, best of a gain grid", "PI"))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(controller_study, "sines", lambda *args: ())
        return controller_study.simulated(scene, designs, 1e-6)


@pytest.mark.promise("pointing-115")
def test_the_report_has_it_in_each_budget_with_its_size_and_origin(fine):
    text = " ".join(views_text([fine_pointing_view(fine, 10e-6, ())], 400).split())
    data = fine_pointing_data(fine, 10e-6)
    (found,) = (each for each in fine.scene.loop.disturbances[0] if each.name == "angle of arrival")
    said = (
        f"Angle of arrival, {angle(found.rms_rad)} rms per axis before the loop: the tracked light comes down through"
    )
    assert said in text
    assert "tilt zernike; from 100 mHz to" in text
    assert "Source: literature: profile 5/7; assumption: the plane that fits best." in text
    assert f"angle of arrival {angle(found.rms_rad)}" in text  # among the disturbances
    assert data["angle_of_arrival"]["rms_rad"] == found.rms_rad
    (part,) = (each for each in data["error_budget"]["parts"] if each["name"] == "angle of arrival")
    assert part["rms_rad"] == pytest.approx(part["theory_rms_rad"], rel=0.2)
    assert 0.0 < data["controllers"][1]["theory_rms_by_source_rad"]["angle of arrival"] < found.rms_rad


@pytest.mark.promise("pointing-115")
def test_the_command_has_it_among_the_sources(call, folder):
    (folder / "m.toml").write_text(station_text(), encoding="utf-8")
    found = call("pointing", "m.toml")
    assert found.code == 0
    rows = re.findall(r"^ angle of arrival +(\S+) ", found.out, flags=re.MULTILINE)
    assert len(rows) == 2
    assert float(rows[0]) < float(rows[1])
    said = " ".join(found.out.split())
    assert "comes down through the air of channel.turbulence, light of 1.55 µm in 50 mm at 20 deg of elevation" in said
    data = json.loads(call("pointing", "m.toml", "--json").out)
    own = angle_of_arrival(arrival_of(station_file(folder)))
    assert data["angle_of_arrival"]["rms_rad"] == own.rms_rad
    assert data["indices"][0]["without_the_loop_rad"]["angle of arrival"] == pytest.approx(2**0.5 * own.rms_rad)


def test_nothing_is_said_of_it_in_still_air(call, folder):
    (folder / "m.toml").write_text(station_text(""), encoding="utf-8")
    found = call("pointing", "m.toml")
    assert found.code == 0
    assert "rrival" not in found.out
    assert "angle_of_arrival" not in json.loads(call("pointing", "m.toml", "--json").out)
    assert TURBULENCE in station_text()


def test_a_mirror_of_unknown_dynamics_is_not_marked_as_met(fine):
    class Unknown:
        """The scene of a mirror whose dynamics are not known."""

        unknown_dynamics = "its dynamics are not known"

        def __getattr__(self, name):
            return getattr(fine.scene, name)

    for of, met in ((fine, True), (replace(fine, scene=Unknown()), False)):
        assert fine_pointing_view(of, 1.0, ()).blocks[0].good is met
