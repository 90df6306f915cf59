"""The angle at which light arrives out of turbulent air, as a disturbance of the loop of a station."""

import math
import sys
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from microrad import link, mirror
from microrad.link.turbulence import BuftonWind, Downlink, HufnagelValley, SlantPath
from microrad.loop import controller_study, coupled_study, disturbance
from microrad.loop.controller_study import parts
from microrad.loop.pointing_loop import ensemble
from microrad.loop.pointing_loop.linear import close, sensitivity, stationary
from microrad.mission.file import MissionError, load_mission
from scenes import scene_of
from shipped import DEFAULT, SHIPPED
from station_files import TURBULENCE, station_file, station_text

NAME = "angle of arrival"


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    return station_file(tmp_path_factory.mktemp("station"))


@pytest.fixture(scope="module")
def arrival(file):
    return link.arrival_of(file)


@pytest.fixture(scope="module")
def scene(file):
    return scene_of(file)


def by_hand(wind=None):
    """The light of the mission by the closed forms themselves: aperture, and the downlink with its wind."""
    usual = BuftonWind()
    scale = 21.0 / usual.rms_m_s
    wind = wind or BuftonWind(scale * usual.ground_m_s, scale * usual.jet_m_s, slew_rad_s=255e-6)
    return 0.05, Downlink(SlantPath(HufnagelValley(1.7e-14, 21.0, 2393.0), 1.55e-6, math.radians(20.0), 1.2e6)), wind


def of_axis(scene):
    (found,) = (each for each in scene.loop.disturbances[0] if each.name == NAME)
    return found


@pytest.mark.promise("pointing-112")
def test_the_spectrum_is_that_of_the_answers_light_in_the_loops_aperture(arrival):
    aperture, down, wind = by_hand()
    for at in (3, 40):
        freq = arrival.freq_hz[at]
        expected = float(down.arrival_psd_rad2_hz(np.array([freq]), aperture, wind)[0])
        assert arrival.psd_rad2_hz[at] == pytest.approx(expected, rel=1e-9)
    assert arrival.rms_rad == pytest.approx(down.arrival_rms_rad(aperture), rel=1e-12)
    assert arrival.freq_hz[0] == 0.1


@pytest.mark.promise("pointing-113")
def test_the_filter_has_the_closed_rms_but_for_what_is_slower_than_the_spectrum(arrival, scene):
    aperture, down, wind = by_hand()
    low = np.geomspace(1e-7, 0.1, 200)
    slower = np.trapezoid(down.arrival_psd_rad2_hz(low, aperture, wind), low)
    within = math.sqrt(down.arrival_rms_rad(aperture) ** 2 - float(slower))
    found = of_axis(scene)
    # 1 % of numerical integration, 1 % of the fit and 1e-4 of the variance above the spectrum
    freq = np.geomspace(0.1, 20e3, 3000)
    assert math.sqrt(np.trapezoid(disturbance.psd(found, freq), freq)) == pytest.approx(within, rel=0.02)
    assert within < found.rms_rad < down.arrival_rms_rad(aperture)
    assert f"{within * 1e6:.0f}" == f"{found.rms_rad * 1e6:.0f}" == "6"


@pytest.mark.promise("pointing-113")
@pytest.mark.parametrize("at_hz", [1.0, 20.0, 150.0])
def test_the_filter_follows_the_spectrum(scene, at_hz):
    aperture, down, wind = by_hand()
    found = float(disturbance.psd(of_axis(scene), np.array([at_hz]))[0])
    expected = float(down.arrival_psd_rad2_hz(np.array([at_hz]), aperture, wind)[0])
    assert abs(10.0 * math.log10(found / expected)) < 0.5


@pytest.mark.promise("pointing-113")
@pytest.mark.parametrize(
    ("tilt", "aperture", "rate"),
    [pytest.param("zernike", "5 cm", "0 urad/s", marks=pytest.mark.endurance), ("gradient", "40 cm", "15 mrad/s")],
)
def test_what_a_loop_leaves_of_it_is_that_of_the_spectrum(tmp_path, tilt, aperture, rate):
    """Behind a high pass of first order, as a loop of that crossover has it: within a few per cent."""
    changes = (
        ('tilt = "zernike"', f'tilt = "{tilt}"'),
        ('leo_aperture = "5 cm"', f'leo_aperture = "{aperture}"'),
        ('line_of_sight_rate = "255 urad/s"', f'line_of_sight_rate = "{rate}"'),
    )
    file = station_file(tmp_path, *changes)
    found = disturbance.angle_of_arrival(link.arrival_of(file))
    usual = BuftonWind()
    scale = 21.0 / usual.rms_m_s
    slew = file.mission.fine_pointing.reference.line_of_sight_rate_rad_s
    _, down, wind = by_hand(BuftonWind(scale * usual.ground_m_s, scale * usual.jet_m_s, slew_rad_s=slew))
    freq = np.geomspace(1e-3, 1e5, 400)
    true = down.arrival_psd_rad2_hz(freq, file.mission.terminals.leo_aperture_m, wind, tilt)
    for crossover, allowed in ((20.0, 0.02), (100.0, 0.02), (500.0, 0.06)):
        left = freq**2 / (freq**2 + crossover**2)
        ratio = np.trapezoid(left * disturbance.psd(found, freq), freq) / np.trapezoid(left * true, freq)
        assert math.sqrt(ratio) == pytest.approx(1.0, abs=allowed)


def test_a_loop_leaves_the_root_sum_square_of_it_and_of_the_rest(scene):
    """In theory as by an integral over the closed form, and simulated, without hysteresis."""
    (made,) = controller_study.design(scene, only=("PI",))
    straight = parts.without(scene.loop, parts.HYSTERESIS, parts.QUANTISATION, parts.LIMITS)
    closed = close(scene.theory, made.controller)
    theory = stationary(closed).error_by_source[NAME]
    aperture, down, wind = by_hand()
    freq = np.geomspace(0.05, 2499.0, 400)
    passed = np.abs(sensitivity(closed, freq)[:, 0, 0]) ** 2
    left = float(np.trapezoid(passed * down.arrival_psd_rad2_hz(freq, aperture, wind), freq))
    assert math.sqrt(theory[0]) == pytest.approx(math.sqrt(left), rel=0.03)
    cases = [ensemble.Case(loop, made.controller, False) for loop in (straight, parts.without(straight, NAME))]
    whole, rest = ensemble.simulate_cases(cases, ensemble.Span(2.0, 0.5, 1), 64)
    added = math.sqrt(whole.radial_rms_rad**2 - rest.radial_rms_rad**2)
    assert added == pytest.approx(math.sqrt(2.0 * left), rel=0.05)
    assert whole.radial_rms_rad > 1.05 * rest.radial_rms_rad


@pytest.mark.promise("pointing-114")
def test_it_is_a_source_of_error_behind_the_others_which_stay_as_they_are(tmp_path, scene):
    still = scene_of(station_file(tmp_path, turbulence=""))
    assert parts.sources(scene.loop)[:3] == ("OLYMPUS", "body pointing", NAME)
    for axis, other in zip(scene.loop.disturbances, still.loop.disturbances, strict=True):
        assert [each.name for each in axis] == [*(each.name for each in other), NAME]
        for own, same in zip(axis, other, strict=False):
            assert (own.basis, own.source, own.lines) == (same.basis, same.source, same.lines)
            assert all(getattr(own, key).tobytes() == getattr(same, key).tobytes() for key in "ABC")


@pytest.mark.promise("pointing-114")
def test_there_is_none_where_the_terminal_flies_or_the_air_is_still(tmp_path):
    flying = load_mission(DEFAULT)
    assert link.arrival_of(flying) is link.arrival_of(load_mission(SHIPPED)) is None
    assert link.arrival_of(station_file(tmp_path, turbulence="")) is None
    text = station_text()
    begin, middle, end = (text.index(key) for key in ("[orbit.leo]", "[orbit.geo]", f"# {'-' * 97} operations"))
    below, above = text[begin:middle], text[middle:end]
    turned = above.replace("orbit.geo", "orbit.leo") + below.replace("orbit.leo", "orbit.geo")
    partner = load_mission(tmp_path / "m.toml", text=text[:begin] + turned + text[end:])
    assert partner.mission.path.station == "geo"
    assert link.arrival_of(partner) is None
    assert NAME not in parts.sources(scene_of(partner).loop)


def test_a_station_may_be_said_in_the_channel(tmp_path):
    text = station_text()
    text = text[: text.index(f"# {'-' * 97} orbits")] + text[text.index(f"# {'-' * 97} fast steering mirror") :]
    said = '[channel]\nstation = "leo"\nelevation = "20 deg"\nheight = "2393 m"\naltitude = "500 km"\n'
    file = load_mission(tmp_path / "m.toml", text=text.replace("[channel]\n", said))
    _, down, _ = by_hand()
    assert link.arrival_of(file).rms_rad == pytest.approx(down.arrival_rms_rad(0.05), rel=1e-12)


def test_a_loop_without_the_spectrum_is_refused(file):
    with pytest.raises(ValueError, match=r"turbulence of channel\.turbulence: give the spectrum of its angle"):
        controller_study.scene(file, mirror.of(file.mission), link.tracking_light_w(file))
    with pytest.raises(ValueError, match=r"link\.arrival_of has"):
        coupled_study.of_mission(file, mirror.of(file.mission), link.tracking_light_w(file))


def test_air_at_rest_has_no_spectrum(tmp_path):
    still = ('wind_rms = "21 m/s"', 'wind_rms = "0 m/s"')
    rest = ('line_of_sight_rate = "255 urad/s"', 'line_of_sight_rate = "0 urad/s"')
    with pytest.raises(ValueError, match=r"at rest at some height, and its angle of arrival has no spectrum.*give a"):
        link.arrival_of(station_file(tmp_path, still, rest))
    assert link.arrival_of(station_file(tmp_path, still)).rms_rad > 0.0


def test_a_wind_beyond_all_winds_is_refused_by_its_key(tmp_path):
    with pytest.raises(ValueError, match=r"channel\.turbulence\.wind_rms has no wind .* 261\.3 m/s: it must be"):
        link.arrival_of(station_file(tmp_path, ('wind_rms = "21 m/s"', 'wind_rms = "200 m/s"')))


@pytest.mark.endurance
@pytest.mark.parametrize(("wind", "aperture"), [("0.2 m/s", "1 m"), ("150 m/s", "2 cm")])
def test_slow_and_fast_air_over_small_and_large_apertures_have_a_filter(tmp_path, wind, aperture):
    changes = ('wind_rms = "21 m/s"', f'wind_rms = "{wind}"'), ('leo_aperture = "5 cm"', f'leo_aperture = "{aperture}"')
    arrival = link.arrival_of(station_file(tmp_path, *changes))
    assert arrival.freq_hz[0] <= 0.1
    assert 100.0 * arrival.freq_hz[0] < arrival.freq_hz[-1] <= 0.5 / 40e-6 * (1.0 + 1e-12)
    assert 0.0 < disturbance.angle_of_arrival(arrival).rms_rad < arrival.rms_rad


def test_a_measured_wind_is_that_of_the_table(tmp_path):
    table = '[channel.turbulence.wind]\nground = "3 m/s"\njet = "40 m/s"\npeak = "10 km"\nwidth = "5 km"\n'
    given = TURBULENCE.replace('wind_rms = "21 m/s"       # literature: profile 5/7\n', "") + "\n" + table
    arrival = link.arrival_of(station_file(tmp_path, turbulence=given))
    wind = BuftonWind(3.0, 40.0, 10e3, 5e3, 255e-6)
    profile = HufnagelValley(1.7e-14, replace(wind, slew_rad_s=0.0).rms_m_s, 2393.0)
    down = Downlink(SlantPath(profile, 1.55e-6, math.radians(20.0), 1.2e6))
    expected = down.arrival_psd_rad2_hz(np.array(arrival.freq_hz), 0.05, wind)
    assert arrival.psd_rad2_hz == pytest.approx(expected.tolist(), rel=1e-9)


@pytest.mark.parametrize(
    ("key", "table"),
    [
        (
            "operations.downlink",
            '[operations.downlink]\ndata_rate = "100 Mbit/s"\nsetup = "20 s"\ndelay = "1 s"\n\n'
            '[operations.downlink.stations.kiruna]\nlatitude = "67.9 deg"\nlongitude = "21 deg"\nheight = "402 m"\n'
            'mask = "5 deg"\n\n',
        ),
        (
            "constellation",
            '[constellation]\npattern = "delta"\nsatellites = 12\nplanes = 3\nphasing = 1\nterminals = 1\n'
            'overhead = "60 s"\nsession = "10 min"\nshortest = "3 min"\n\n'
            '[constellation.relays.east]\nlongitude = "143 deg"\n\n',
        ),
    ],
)
def test_what_only_a_satellite_has_is_refused_beside_a_station(tmp_path, key, table):
    text = station_text().replace("[mirror]\n", f"{table}[mirror]\n", 1)
    with pytest.raises(MissionError) as refused:
        load_mission(tmp_path / "m.toml", text=text)
    assert [each.key for each in refused.value.faults] == [key]
    assert 'stands beside orbit.leo of kind "station", and means a satellite there' in str(refused.value)


def test_the_fitted_angle_says_of_which_light_and_air_it_is_between_which_frequencies_and_from_where(monkeypatch):
    asked = []

    def fit_table(*columns, **said):
        asked.append((columns, said))
        return SimpleNamespace(
            disturbance=replace(disturbance.olympus(), name=said["name"], source=said["source"], basis="as fitted")
        )

    monkeypatch.setattr(sys.modules[disturbance.angle_of_arrival.__module__], "fit_table", fit_table)
    given = disturbance.Arrival((0.2, 7.0, 2e3), (3e-12, 2e-12, 1e-15), 1e-6, "a light at 20 degrees", "a page")
    found = disturbance.angle_of_arrival(given)
    assert (found.name, found.source) == ("angle of arrival", "a page")
    assert found.basis == "a light at 20 degrees; from 200 mHz to 2 kHz; as fitted"
    said = {"convention": "per-axis", "name": "angle of arrival", "source": "a page"}
    assert asked == [(((0.2, 7.0, 2e3), (3e-12, 2e-12, 1e-15)), said)]
    other = disturbance.angle_of_arrival(replace(given, basis="another light", source="another page"))
    assert (other.source, other.basis) == ("another page", "another light; from 200 mHz to 2 kHz; as fitted")


def test_its_spectrum_ends_at_half_the_rate_of_the_plant_s_steps_where_the_air_is_faster(tmp_path):
    file = station_file(tmp_path, ('line_of_sight_rate = "255 urad/s"', 'line_of_sight_rate = "50 mrad/s"'))
    ends = []
    for step_s in (1e-2, 2e-2, 1e-9):
        fine = file.mission.fine_pointing.model_copy(update={"plant_step_s": step_s})
        mission = file.mission.model_copy(update={"fine_pointing": fine})
        ends.append(link.arrival_of(replace(file, mission=mission)).freq_hz[-1])
    assert ends[:2] == pytest.approx([50.0, 25.0], rel=1e-12) and 50.0 < ends[2] < 1e7
