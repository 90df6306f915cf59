"""Links to a station as whole budgets: by hand, against drawn losses, over elevation, and by each road to a margin."""

import itertools
import math
from functools import cache

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.special import ndtr, ndtri

from ground_files import FIBRE, PHOTODIODE, STILL, TYPED, UP, WIND, ground_file
from microrad import link
from microrad.link import ground
from microrad.link import study as link_study
from microrad.link.ground import ground_link
from microrad.link.pointing import outage
from microrad.link.turbulence import Downlink, HufnagelValley
from microrad.link.variation import beam_tornado, divergence_possible

deg = math.pi / 180.0
DB = 10.0 / math.log(10.0)
PLANCK, LIGHT_M_S = 6.62607015e-34, 299792458.0
STATIC = {"jitter": None, "channel.turbulence.fades": "log-normal"}
RISING = (*UP.items(), ("terminals.leo_aperture", "12 cm"), ("terminals.geo_aperture", "8 cm"))
RISING = {**dict(RISING), "terminals.geo_obscuration": None}


def lg(value):
    return 10.0 * math.log10(value)


def lines_of(budget):
    return {line.name: line.value for line in budget.lines}


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    return link_study.run_link_study(ground_file(tmp_path_factory.mktemp("ground")))


# --------------------------------------------------------------------------------------------------- a path by hand
class Path:
    """The mission's path with the formulas of Andrews and Phillips, each integral over height by a quadrature."""

    def __init__(self, wavelength_m, elevation=20.0 * deg):
        sea = 2393.0
        square = 1.0 / 298.257223563 * (2.0 - 1.0 / 298.257223563)
        sine, cosine = math.sin(28.3 * deg), math.cos(28.3 * deg)
        normal = 6378137.0 / math.sqrt(1.0 - square * sine**2)
        own = math.hypot((normal + sea) * cosine, (normal * (1.0 - square) + sea) * sine)
        rise, level = own * math.sin(elevation), own * math.cos(elevation)
        self.range_m = math.sqrt((6378137.0 + 500e3) ** 2 - level**2) - rise
        self.k, self.wavelength_m, self.slant = 2.0 * math.pi / wavelength_m, wavelength_m, 1.0 / math.sin(elevation)
        self.r0 = (0.423 * self.k**2 * self.over(lambda z: 1.0)) ** -0.6

    @staticmethod
    def strength(height):
        sea = height + 2393.0
        jet = 0.00594 * (21.0 / 27.0) ** 2 * (1e-5 * sea) ** 10 * math.exp(-sea / 1000.0)
        return jet + 2.7e-16 * math.exp(-sea / 1500.0) + 1.7e-14 * math.exp(-height / 100.0)

    def over(self, function):
        """Integral of Cn2 times a function of the distance from the station, along the path."""
        edges = (0.0, 200.0, 1e3, 4e3, 9e3, 15e3, 25e3, 60e3)
        parts = itertools.pairwise(edges)
        along = lambda h: self.strength(h) * function(h * self.slant) * self.slant  # noqa: E731
        return sum(quad(along, *part, epsrel=1e-8)[0] for part in parts)

    def averaged_index(self, diameter):
        a = diameter**2 / 16.0
        wave = lambda z: ((a + 1j * z / self.k) ** (5.0 / 6.0)).real - a ** (5.0 / 6.0)  # noqa: E731
        return 8.70 * self.k**2 * self.over(wave)

    def index_of_beam(self, waist):
        far = 2.0 * self.range_m / (self.k * waist**2)
        theta, width = 1.0 / (1.0 + far**2), far / (1.0 + far**2)

        def wave(z):
            xi = 1.0 - z / self.range_m
            a = width * self.range_m * xi**2 / self.k
            b = self.range_m * xi * (1.0 - (1.0 - theta) * xi) / self.k
            return ((a + 1j * b) ** (5.0 / 6.0)).real - a ** (5.0 / 6.0)

        return 8.70 * self.k**2 * self.over(wave)

    def wander_rad2(self, waist):
        far = 2.0 / (self.k * waist**2)
        return 2.07 * self.over(
            lambda z: (1.0 - z / self.range_m) ** 2 * (waist * math.hypot(1.0, far * z)) ** (-1.0 / 3.0)
        )


def normal_loss_db(index, outage_share):
    variance = math.log(1.0 + index)
    return DB * (variance / 2.0 - math.sqrt(variance) * ndtri(outage_share))


def clear_db(wavelength_m, mass):
    um = wavelength_m * 1e6
    rayleigh = 0.008569 * um**-4 * (1.0 + 0.0113 * um**-2 + 0.00013 * um**-4) * math.exp(-2393.0 / 8434.5)
    return mass * (DB * (rayleigh + 0.05 * um**-1.3) + 0.05)


MASS = 1.0 / (math.sin(20.0 * deg) + 0.50572 * (20.0 + 6.07995) ** -1.6364)


@pytest.mark.promise("link-110", "link-111")
def test_a_downlink_is_the_sum_of_its_lines_by_hand(tmp_path):
    data = link.of(ground_file(tmp_path, STATIC).mission)
    budget = link.communication_budget(data, {})
    wave = 1.55e-6
    path = Path(wave)
    wanted = {
        "Transmit power": 30.0,
        "satellite aperture gain": 2.0 * lg(math.pi * 0.05 / wave),
        "Transmit optics loss": -0.97,
        "Strehl loss": -DB * (2.0 * math.pi * 80e-9 / wave) ** 2,
        "Pointing loss": -DB * 2.0 * (10e-6 / (2.0 * wave / (math.pi * 0.05))) ** 2,
        "Point-ahead loss": 0.0,
        "Free-space loss": -2.0 * lg(4.0 * math.pi * path.range_m / wave),
        "Clear-sky loss": -clear_db(wave, MASS),
        "Tenerife aperture gain": 2.0 * lg(math.pi * 0.4 / wave),
        "Tenerife obscuration loss": lg(1.0 - 0.3**2),
        "Receive optics loss": -0.97,
        "Turbulence fade": -normal_loss_db(path.averaged_index(0.4), 0.01),
        "Tracking split loss": -0.46,
        "Implementation loss": -3.0,
    }
    assert lines_of(budget) == pytest.approx(wanted, abs=2e-3)
    assert wanted["Turbulence fade"] < -1.5
    needed = lg(500.0 * PLANCK * LIGHT_M_S / wave * 10e9 * 1e3)
    assert budget.margin_db == pytest.approx(sum(wanted.values()) - needed, abs=4e-3)
    assert budget.margin_db == pytest.approx(sum(lines_of(budget).values()) - needed, abs=1e-6)


def wandering_loss_db(index, beam, share):
    """The loss of a share of the time, by the integral over the radial wander, halved until it is found."""
    variance = math.log(1.0 + index)

    def below(db):
        def each(x):
            at = math.log(beam / (beam + 1.0)) - db / DB + x / beam
            return math.exp(-x) * ndtr((at + variance / 2.0) / math.sqrt(variance))

        return quad(each, 0.0, 12.0, epsrel=1e-9)[0] + quad(each, 12.0, 40.0, epsrel=1e-9)[0]

    low, high = -10.0, 40.0
    for _ in range(45):
        middle = (low + high) / 2.0
        low, high = (middle, high) if below(middle) > share else (low, middle)
    return low


def for_any_strength(variance, scales=0.56):
    """Index of a wide uplink, of the variance of weak turbulence; with 1.11 that of a downlink."""
    root = variance**1.2
    large = 0.49 * variance / (1.0 + scales * root) ** (7.0 / 6.0)
    return math.exp(large + 0.51 * variance / (1.0 + 0.69 * root) ** (5.0 / 6.0)) - 1.0


@pytest.mark.promise("link-111")
def test_an_uplink_is_the_sum_of_its_lines_by_hand(tmp_path):
    data = link.of(ground_file(tmp_path, STATIC, RISING).mission)
    budget = link.communication_budget(data, {})
    wave = 1.55e-6
    path, half, waist = Path(wave), 2.0 * wave / (math.pi * 0.12), 0.06
    spread = 12.0 * math.log10(1.0 + (math.sqrt(8.0) * waist / path.r0) ** (5.0 / 3.0))
    beam = half**2 * 10.0 ** (spread / 10.0) / (2.0 * path.wander_rad2(waist))
    wanted = {
        "Transmit power": 30.0,
        "satellite aperture gain": 2.0 * lg(math.pi * 0.12 / wave),
        "Transmit optics loss": -0.97,
        "Strehl loss": -DB * (2.0 * math.pi * 80e-9 / wave) ** 2,
        "Pointing loss": -DB * 2.0 * (10e-6 / half) ** 2,
        "Point-ahead loss": 0.0,
        "Free-space loss": -2.0 * lg(4.0 * math.pi * path.range_m / wave),
        "Clear-sky loss": -clear_db(wave, MASS),
        "Turbulence spread loss": -spread,
        "Tenerife aperture gain": 2.0 * lg(math.pi * 0.08 / wave),
        "Receive optics loss": -0.97,
        "Turbulence fade": -wandering_loss_db(for_any_strength(path.index_of_beam(waist)), beam, 0.01),
        "Tracking split loss": -0.46,
        "Implementation loss": -3.0,
    }
    assert lines_of(budget) == pytest.approx(wanted, abs=5e-3)
    assert spread > 2.0 and wanted["Turbulence fade"] < -3.0
    # the answer comes down, and falls on the station's telescope: it does not spread, and its fades are averaged
    answer = lines_of(link.beam_budget("answer", data.shared, ground_file(tmp_path, STATIC, RISING).mission.answer, {}))
    assert "Turbulence spread loss" not in answer
    assert answer["Turbulence fade"] == pytest.approx(
        -normal_loss_db(for_any_strength(Path(1.06e-6).averaged_index(0.12), 1.11), 0.01), abs=2e-3
    )
    assert answer["Clear-sky loss"] == pytest.approx(-clear_db(1.06e-6, MASS), abs=1e-3)


def test_air_takes_of_the_irradiance_above_it_and_nothing_of_what_leaves_the_terminal(tmp_path):
    """A far-field test of the terminal measures no spread; the irradiance at the satellite has it, and no fades."""
    budgets = []
    for air in ({}, STILL):
        data = link.of(ground_file(tmp_path, STATIC, RISING, air).mission)
        budgets.append(link.communication_budget(data, {}))
    moved, still = budgets
    assert moved.radiant_intensity_w_sr == pytest.approx(still.radiant_intensity_w_sr, rel=1e-12)
    spread = moved.loss_db("Turbulence spread loss")
    assert lg(still.irradiance_w_m2 / moved.irradiance_w_m2) == pytest.approx(spread, abs=1e-9)
    fade = moved.loss_db("Turbulence fade")
    assert still.margin_db - moved.margin_db == pytest.approx(spread + fade, abs=1e-9)
    assert spread > 1.0 and fade > 1.0


def test_a_fade_stands_at_the_outage_of_the_mission(tmp_path):
    index = Path(1.55e-6).averaged_index(0.4)
    for share in (0.1, 1e-4):
        data = link.of(ground_file(tmp_path, STATIC, {"requirement.outage": share}).mission)
        assert data.fade_db == pytest.approx(normal_loss_db(index, share), abs=2e-3)


# ------------------------------------------------------------------------------------------------------ drawn losses
@pytest.mark.parametrize("share", [1e-2, 1e-3])
@pytest.mark.promise("link-111")
def test_jitter_a_receiver_of_its_own_and_fades_lose_together_what_drawn_losses_do(tmp_path, share):
    """Three losses are drawn independently and added; the sum is read where it is exceeded for the outage."""
    jitter = {"bias": ["0.2 urad", "0 urad"], "rms": ["0.5 urad", "0.5 urad"], "bandwidth": "50 Hz"}
    changes = {
        "channel.turbulence.fades": "log-normal",
        "communication.coupling": {**FIBRE, "jitter": jitter},
        "requirement.outage": share,
    }
    data = link.of(ground_file(tmp_path, changes).mission)
    rng, count = np.random.default_rng(11), 400_000
    sent = np.hypot(2e-6 + 2e-6 * rng.standard_normal(count), 2e-6 * rng.standard_normal(count))
    lost = DB * 2.0 * (sent / (2.0 * 1.55e-6 / (math.pi * 0.05))) ** 2
    end = data.receiving.end
    x, y = 0.2e-6 + 0.5e-6 * rng.standard_normal(count), 0.5e-6 * rng.standard_normal(count)
    received = end.loss_db(x, y) - float(end.loss_db(0.0))
    variance = math.log1p(Path(1.55e-6).averaged_index(0.4))
    faded = -DB * (math.sqrt(variance) * rng.standard_normal(count) - variance / 2.0)
    wanted = np.quantile(lost + received + faded, 1.0 - share)
    alone = np.quantile(lost, 1.0 - share)
    stated = outage.Exposure.stated(data)
    assert stated.outage_loss_db == pytest.approx(wanted, abs=0.03 if share > 5e-3 else 0.12)
    assert data.added_db == pytest.approx(wanted - alone, abs=0.05 if share > 5e-3 else 0.15)
    without = np.quantile(lost + received, 1.0 - share)
    assert data.fade_db == pytest.approx(wanted - without, abs=0.05 if share > 5e-3 else 0.15)
    assert data.receive_pointing_db == pytest.approx(without - alone, abs=0.05 if share > 5e-3 else 0.15)
    assert data.fade_db > 0.3 and data.receive_pointing_db > 0.3


# ---------------------------------------------------------------------------------------------- one margin, many roads
@pytest.mark.parametrize("changes", [{}, RISING, {"communication.coupling": PHOTODIODE}, STATIC, STILL, TYPED])
@pytest.mark.promise("link-112")
def test_each_road_to_a_margin_ends_at_the_same_one(tmp_path, changes):
    file = ground_file(tmp_path, changes)
    m = file.mission
    data = link.of(m)
    error, rate = outage.error_rad(data), data.table.data_rate_bit_s
    budget = link.communication_budget(data, file.sources, error).margin_db
    exposure = outage.Exposure.stated(data)
    assert exposure.margin_db == pytest.approx(budget, abs=1e-9)
    assert float(link.margin_map(data, [rate], [error])[0, 0]) == pytest.approx(budget, abs=1e-9)
    assert outage.margin_db(data) == pytest.approx(budget, abs=1e-9)
    if m.jitter is not None:
        assert exposure.short_of(budget) == pytest.approx(0.01, rel=1e-4)
    assert exposure.short_of(budget - 2.0) < exposure.short_of(budget + 0.5)


@pytest.mark.promise("link-112")
def test_the_study_has_the_same_margin_as_its_tornado_and_its_figures(study):
    own = study.communication.margin_db
    assert study.under_jitter.margin_db == pytest.approx(own, abs=1e-9)
    assert study.under_jitter.short == pytest.approx(outage.Exposure.stated(study.data).short_of(3.0), rel=1e-9)
    assert study.ground.elevations[0].margin_db == pytest.approx(own, abs=1e-9)
    tornado, answer = study.tornados
    assert (tornado.margin_db, answer.margin_db) == (own, study.answer.margin_db)
    keys = {each.key for each in tornado.swings}
    assert {"channel.turbulence.wind_rms", "channel.turbulence.ground_strength", "channel.aerosol_depth"} <= keys
    assert {"channel.absorption", "answer.wavelength", "requirement.outage"} <= {each.key for each in answer.swings}
    assert math.isnan(study.under_jitter.fades_per_s)
    assert study.under_jitter.fade_warning == "fades are not counted: those of the air have no spectrum here"


def test_the_static_margin_beside_a_jitter_is_that_of_a_file_without_it(study, tmp_path):
    """What fades add to the losses of a jitter is less than what they take alone."""
    alone = link.of(ground_file(tmp_path, {"jitter": None}).mission)
    line = study.communication.totals[-1]
    assert line.name == "Static margin"
    assert line.value == pytest.approx(outage.margin_db(alone), abs=1e-9)
    assert line.value == pytest.approx(link.communication_budget(alone, {}).margin_db, abs=1e-9)
    assert alone.fade_db > study.data.fade_db + 0.5


def test_air_that_hardly_moves_light_costs_what_still_air_costs(tmp_path, monkeypatch):
    whole = HufnagelValley.strength
    monkeypatch.setattr(HufnagelValley, "strength", lambda profile, height: 1e-14 * whole(profile, height))
    few = {"channel.turbulence.ground_strength": 1.234e-14}  # of which nothing is kept from another test
    for changes in ({}, RISING, {"communication.coupling": FIBRE}, {"communication.coupling": PHOTODIODE}):
        for fades in ("log-normal", "gamma-gamma"):
            calm = link.of(ground_file(tmp_path, few, changes, {"channel.turbulence.fades": fades}).mission)
            still = link.of(ground_file(tmp_path, changes, STILL).mission)
            assert calm.turbulent is not None and still.turbulent is None
            assert outage.margin_db(calm) == pytest.approx(outage.margin_db(still), abs=2e-4)
            assert calm.air_db == pytest.approx(still.air_db, abs=1e-6)


def test_a_swing_ends_where_the_path_has_no_closed_form(tmp_path):
    """Turbulence has closed forms from 0.1 to 100 um: beyond, there is no link to look at."""
    m = ground_file(tmp_path).mission
    assert link.beam_passes(m)
    assert not link.beam_passes(m.with_value("communication.wavelength_m", 2e-4))
    possible = divergence_possible("answer")
    assert possible(m)
    assert not possible(m.with_value("answer.wavelength_m", 2e-4))
    assert not possible(m.with_value("answer.divergence_rad", 1e-7))  # narrower than its aperture makes it


@pytest.mark.parametrize("velocity", ["0 m/s", pytest.param("500 m/s", marks=pytest.mark.endurance), "7.5 km/s"])
def test_more_corrected_modes_never_cost_an_uplink_its_margin(tmp_path, velocity):
    """Adaptive optics takes tilt out, too, and with it the wander; the point-ahead angle leaves some of both."""
    wide = {**RISING, "terminals.leo_aperture": "30 cm", "point_ahead.transverse_velocity": velocity}
    found = []
    for modes in (0, 3, 6, 20, 100, 1000):
        data = link.of(ground_file(tmp_path, STATIC, wide, {"channel.turbulence.corrected_modes": modes}).mission)
        found.append(data.turbulent)
    lost = [each.spread_db + each.fades.loss_db(0.01) for each in found]
    assert np.all(np.diff(lost) < 1e-9)
    assert np.all(np.diff([each.wander_rad for each in found]) <= 0.0)
    if velocity == "0 m/s":
        assert lost[-1] < lost[0] - 10.0
        # the variance of 1000 modes, all of it tilt of a wavefront over sqrt(8) waists of 15 cm
        diameter = math.sqrt(8.0) * 0.15
        variance = 0.2944 * 1000 ** (-math.sqrt(3.0) / 2.0) * (diameter / found[0].path.fried_m) ** (5.0 / 3.0)
        assert found[-1].spread_db == pytest.approx(DB * variance, rel=1e-9)
        angle = math.sqrt(variance) * 2.0 * 1.55e-6 / (math.pi * diameter)
        assert found[-1].wander_rad == pytest.approx(angle, rel=1e-9)
    if velocity == "7.5 km/s":  # five isoplanatic angles ahead the beam goes through other air
        assert lost[-1] == lost[0]
        assert "the point-ahead angle is" in found[-1].doubts[-1]


# ----------------------------------------------------------------------------------------------------- over elevation
def test_what_a_higher_satellite_gains_is_the_margin_of_a_mission_at_that_elevation(tmp_path):
    quick = {"channel.turbulence.fades": "log-normal"}
    data = link.of(ground_file(tmp_path, quick).mission)
    path, own = data.shared.path, outage.margin_db(data)
    nodes = np.linspace(1.0, 1.0 / math.sin(20.0 * deg), 17)
    for place, longer in enumerate(nodes[1:-1:4]):
        for inverse, close in ((longer, 1e-9), (longer + 0.4 * (nodes[1] - nodes[0]), 3e-3)):
            elevation = math.asin(1.0 / inverse)
            higher = ground_file(tmp_path, quick, {"orbit.geo.mask": f"{elevation / deg:.12f} deg"}).mission
            there = link.of(higher)
            assert there.range_m == pytest.approx(path.range_at(elevation), abs=1e-3)
            gained = outage.margin_db(there) - own
            assert float(link.farther_db(data, there.range_m)) == pytest.approx(-gained, abs=max(close, 1e-7)), place
            assert gained > 20.0 * math.log10(data.range_m / there.range_m) + 0.05  # the air is thinner, too


def test_behind_the_elevation_of_the_budget_the_range_alone_counts(tmp_path):
    data = link.of(ground_file(tmp_path, STATIC).mission)
    farther = link.farther_db(data, [data.range_m, 1.5 * data.range_m, 10.0 * data.range_m])
    assert farther == pytest.approx([0.0, 20.0 * math.log10(1.5), 20.0], abs=1e-9)
    nearest = data.shared.path.range_at(math.pi / 2.0)
    above, nearer = link.farther_db(data, [nearest, nearest / 2.0])
    assert nearer == pytest.approx(above - 20.0 * math.log10(2.0), abs=1e-9)
    assert link.farther_db(data, np.full((2, 3), data.range_m)).shape == (2, 3)
    vacuum = link.of(ground_file(tmp_path, {**TYPED, "channel": None, **FAR}).mission)
    assert float(link.farther_db(vacuum, 500e3)) == pytest.approx(-20.0 * math.log10(2.0), abs=1e-12)


FAR = {"communication.distance": "1000 km", "answer.distance": "1000 km"}


def test_the_table_over_elevation_is_that_of_missions_at_each(study, tmp_path):
    elevations = [each.elevation_rad / deg for each in study.ground.elevations]
    assert elevations == pytest.approx([20.0, 30.0, 45.0, 60.0, 90.0])
    for each in study.ground.elevations[1:3]:
        there = link.of(ground_file(tmp_path, {"orbit.geo.mask": f"{each.elevation_rad / deg:g} deg"}).mission)
        assert each.margin_db == pytest.approx(outage.margin_db(there), abs=1e-9)
        assert (each.range_m, each.air_db) == pytest.approx((there.range_m, there.air_db), rel=1e-12)
        assert each.fade_db == pytest.approx(there.fade_db, abs=1e-9)
        path = there.turbulent.path
        assert (each.fried_m, each.isoplanatic_rad) == pytest.approx((path.fried_m, path.isoplanatic_rad), rel=1e-12)
        assert (each.rytov, each.index) == pytest.approx((path.rytov, there.turbulent.index), rel=1e-12)
    # the path is shorter by the ratio of the sines: r0 goes with its power 3 / 5
    first, last = study.ground.elevations[0], study.ground.elevations[-1]
    assert last.fried_m / first.fried_m == pytest.approx(math.sin(20.0 * deg) ** -0.6, rel=1e-9)
    assert last.rytov / first.rytov == pytest.approx(math.sin(20.0 * deg) ** (11.0 / 6.0), rel=1e-9)


# -------------------------------------------------------------------------------------------------------- conventions
@pytest.mark.promise("link-113")
def test_what_a_convention_costs_is_what_the_changed_file_has_less(tmp_path):
    """Both laws of fades, all constants of wander and both tilts, for the data upwards and the answer down."""
    file = ground_file(tmp_path, RISING)
    found = ground_link(file.mission, file.sources, link.of(file.mission)).conventions
    assert [(each.key, each.given, each.other) for each in found] == [
        ("channel.turbulence.fades", "gamma-gamma", "log-normal"),
        ("channel.turbulence.wander", "dios-2004", "itu-r-p1622"),
        ("channel.turbulence.wander", "dios-2004", "andrews-phillips-2005"),
        ("channel.turbulence.tilt", "zernike", "gradient"),
    ]

    def margins(*changes):
        f = ground_file(tmp_path, RISING, *changes)
        data = link.of(f.mission)
        answer = link.beam_budget("answer", data.shared, f.mission.answer, f.sources)
        return {"Communication": outage.margin_db(data), "Answer": answer.margin_db}

    own = margins()
    for each in found:
        other = margins({each.key: each.other})
        assert each.gained_db == pytest.approx({name: other[name] - own[name] for name in own}, abs=1e-9)
    fades, less, wander, tilt = found
    assert wander.gained_db["Communication"] < less.gained_db["Communication"] < 0.0
    assert fades.gained_db["Communication"] > 0.01
    assert wander.gained_db["Communication"] < -1.0 and wander.gained_db["Answer"] == 0.0
    assert set(tilt.gained_db.values()) == {0.0}  # it moves the angle of arrival alone


def test_still_air_has_elevations_and_no_conventions(tmp_path):
    file = ground_file(tmp_path, STILL)
    g = ground_link(file.mission, file.sources, link.of(file.mission))
    assert (g.beams, g.conventions) == ((), ())
    assert len(g.elevations) == 5 and all(math.isnan(each.index) and each.fade_db == 0.0 for each in g.elevations)
    slot = {"orbit.leo": {"kind": "geostationary", "longitude": "-10 deg"}}
    file = ground_file(tmp_path, slot)
    fixed = ground_link(file.mission, file.sources, link.of(file.mission))
    assert len(fixed.elevations) == 1  # it stands where it stands
    file = ground_file(tmp_path, TYPED, FAR, {"channel.altitude": None})
    assert len(ground_link(file.mission, file.sources, link.of(file.mission)).elevations) == 1


def test_the_wind_of_a_table_is_taken_for_the_profile_and_the_greenwood_frequency(tmp_path):
    """Bufton's wind in full, and its root mean square from 5 to 20 km alone, are the same air."""
    square = quad(lambda h: (5.0 + 30.0 * math.exp(-(((h - 9400.0) / 4800.0) ** 2))) ** 2, 5e3, 20e3)[0] / 15e3
    by_table = {"channel.turbulence.wind_rms": None, **STATIC, "channel.turbulence.wind": WIND}
    by_rms = {**STATIC, "channel.turbulence.wind_rms": f"{math.sqrt(square):.9f} m/s"}
    usual, stated = (ground_file(tmp_path, each) for each in (by_table, by_rms))
    lines = {}
    for name, file in (("usual", usual), ("stated", stated)):
        (_, found), _ = ground_link(file.mission, file.sources, link.of(file.mission)).beams
        lines[name] = {line.name: line.value for line in found}
    assert lines["usual"] == pytest.approx(lines["stated"], rel=1e-6)
    calm = {**by_table, "channel.turbulence.wind": {**WIND, "jet": "0 m/s", "ground": "1 m/s"}}
    file = ground_file(tmp_path, calm)
    (_, found), _ = ground_link(file.mission, file.sources, link.of(file.mission)).beams
    slow = {line.name: line.value for line in found}
    assert slow["Greenwood frequency"] < 0.2 * lines["usual"]["Greenwood frequency"]
    assert slow["Scintillation index"] < 0.5 * lines["usual"]["Scintillation index"]


SHAKES = {"jitter": {"bias": ["0.3 urad", "-0.5 urad"], "rms": ["1.1 urad", "0.6 urad"], "bandwidth": "90 Hz"}}
UNLIKE = {
    "fibre": ({"communication.coupling": FIBRE}, SHAKES),
    "up": (UP, {"channel.turbulence.corrected_modes": 7}),
    "disk": (
        {"communication.coupling": PHOTODIODE, "channel.turbulence.corrected_modes": 4},
        {"channel.turbulence.fades": "log-normal", "channel.turbulence.tilt": "gradient"},
    ),
}


@pytest.fixture(scope="module")
def unlike(tmp_path_factory):
    """Links to a station that are unlike each other, each studied once; nobody looks at their tornados."""

    @cache
    def kept(case):
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(link_study, "tornados", lambda *args: ())
            return link_study.run_link_study(ground_file(tmp_path_factory.mktemp(case), *UNLIKE[case]))

    return kept


def lines_with_air(study):
    budgets = [line for each in study.budgets for line in (*each.lines, *each.totals)]
    return [*budgets, *(line for _, lines in study.ground.beams for line in lines)]


def over_elevation(study):
    return [x for e in study.ground.elevations for x in (e.elevation_rad, e.range_m, e.air_db, e.fade_db, e.margin_db)]


def of_the_air(study):
    return [x for e in study.ground.elevations[::2] for x in (e.fried_m, e.isoplanatic_rad, e.rytov, e.index)]


def of_conventions(study):
    return [gained for each in study.ground.conventions for gained in each.gained_db.values()]


def of_lines(study):
    return [line.value for line in lines_with_air(study)]


@pytest.mark.parametrize(("of", "case", "expected"), [
    (over_elevation, "fibre",
     "0.34906585 1197779.53 12.0763454 1.81099593 -1.71228403 0.523598776 913473.819 10.1036347 0.955328341 "
     "3.46970983 0.785398163 686238.887 8.41352989 0.505913859 8.09364476 1.04719755 573203.153 7.47870545 "
     "0.336083996 10.7616341 1.57079633 502382.214 6.84224717 0.245518641 12.6341441"),
    (of_the_air, "fibre",
     "0.111235311 6.41335173e-06 0.291319809 0.0334877975 0.171989789 2.05011568e-05 0.0769264339 0.00410659855 "
     "0.211744268 3.56945872e-05 0.0407503589 0.00147335679"),
    (of_conventions, "fibre",
     "0.0698880562 1.331926 0 -0.000991542018 0 -0.00648058709 0 0"),
    (of_lines, "fibre",
     "30 100.115764 -0.97 -0.456731143 -0.20982239 0 -259.745101 -0.515926964 118.177563 -0.409586077 -0.97 "
     "-1.82987858 0 -11.5604184 -1.81099593 -0.46 -3 -33.6451336 -31.9328496 -1.71228403 -3.89688154 36.9897 "
     "89.0308999 -0.97 -0.976590042 -0.347435586 0 -263.045618 -0.794671082 -0.182730783 103.41628 -0.97 "
     "-8.00724284 -45.8574079 -70 24.1425921 0.111235311 6.41335173e-06 29.1409762 0.291319809 0.0334877975 "
     "4.79798131e-06 0.0705036617 4.06493925e-06 45.9764141 0.453837266 0.410833274 6.47058085e-06"),
    (over_elevation, "up",
     "0.34906585 1197779.53 2.5236302 4.5048791 6.04008594 0.523598776 913473.819 1.80713389 2.7313262 "
     "10.8837508 0.785398163 686238.887 1.31852938 1.66501981 14.9230773 1.04719755 573203.153 1.09236334 "
     "1.21569702 17.1619012 1.57079633 502382.214 0.954478373 0.958580744 18.7023888"),
    (of_the_air, "up",
     "0.111235311 6.41335173e-06 0.291319809 0.190324857 0.171989789 2.05011568e-05 0.0769264339 0.043272299 "
     "0.211744268 3.56945872e-05 0.0407503589 0.0207900506"),
    (of_conventions, "up",
     "0.477961807 0.881305269 -0.459410305 0 -2.95557808 0 0 0"),
    (of_lines, "up",
     "30 100.115764 -0.97 -0.456731143 -1.14616299 0 -259.745101 -0.515926964 -2.00770324 118.177563 "
     "-0.409586077 -0.97 -4.5048791 -0.46 -3 -25.8927637 -31.9328496 6.04008594 4.11463206 36.9897 89.0308999 "
     "-0.97 -0.976590042 -0.347435586 0 -263.045618 -0.794671082 103.41628 -0.97 -6.55086067 -44.218295 -70 "
     "25.781705 0.111235311 6.41335173e-06 29.1409762 0.291319809 0.190324857 6.075214e-06 0.0705036617 "
     "4.06493925e-06 45.9764141 0.453837266 0.291943883 6.78537024e-06"),
    (over_elevation, "disk",
     "0.34906585 1197779.53 0.783080574 1.15420378 10.902527 0.523598776 913473.819 0.529466531 0.457733184 "
     "14.2062273 0.785398163 686238.887 0.371350579 0.172476803 17.1340152 1.04719755 573203.153 0.30206037 "
     "0.0953932509 18.8437241 1.57079633 502382.214 0.261002267 0.0624289781 20.0632328"),
    (of_the_air, "disk",
     "0.111235311 6.41335173e-06 0.291319809 0.0334877975 0.171989789 2.05011568e-05 0.0769264339 0.00410659855 "
     "0.211744268 3.56945872e-05 0.0407503589 0.00147335679"),
    (of_conventions, "disk",
     "-0.0617710903 -1.331926 0 -0.0012497831 0 -0.00821649107 0 0"),
    (of_lines, "disk",
     "30 100.115764 -0.97 -0.456731143 -1.14616299 0 -259.745101 -0.515926964 118.177563 -0.409586077 -0.97 "
     "-0.228783868 0 -0.26715361 -1.15420378 -0.46 -3 -21.0303226 -31.9328496 10.902527 9.06755468 36.9897 "
     "89.0308999 -0.97 -0.976590042 -0.347435586 0 -263.045618 -0.794671082 -0.182730783 103.41628 -0.97 "
     "-6.67531684 -44.5254819 -70 25.4745181 0.111235311 6.41335173e-06 29.1409762 0.291319809 0.0334877975 "
     "4.64129254e-06 0.0705036617 4.06493925e-06 45.9764141 0.453837266 0.410833274 6.47058085e-06"),
])  # fmt: skip
def test_links_to_a_station_unlike_each_other_have_these_numbers(unlike, of, case, expected):
    assert of(unlike(case)) == pytest.approx([float(each) for each in expected.split()], rel=1e-6, abs=1e-12)


@pytest.mark.parametrize(("case", "expected"), [
    ("fibre", [
        ("Free-space loss (dB): (lambda / (4 pi R))^2, R = 1198 km at 20 deg of elevation | mission file, line "
         "83; mission file, line 73 | vacuum, far field | "),
        ("Clear-sky loss (dB): Rayleigh scattering (Hansen and Travis 1974), haze and absorption, times m, air "
         "mass m = 2.903 (Kasten and Young 1989) | mission file, line 29; mission file, line 30; mission file, "
         "line 31; mission file, line 83 | clear sky, from 10 degrees of elevation; no clouds | "),
        ("Turbulence coupling loss (dB): mean power into the single-mode fibre, r0 = 111 mm | mission file, line "
         "33; mission file, line 34 | Kolmogorov's turbulence, long exposure | "),
        ("Turbulence fade (dB): scintillation index 0.0335; what it adds to the pointing loss, all together "
         "exceeded for 1 % of the time | mission file, line 33; mission file, line 34; mission file, line 35; "
         "mission file, line 65 | any strength, by its index | "),
        ("Turbulence spread loss (dB): 12 lg(1 + (D0 / r0)^(5/3)), D0 = sqrt(8) W0, r0 = 70.5 mm | mission file, "
         "line 33; mission file, line 34 | mean power on the axis, wander in it (Andrews and Phillips 2005) | "
         "moderate turbulence: the Rytov variance is 0.454, above 0.3; an index is that for any strength "
         "(Andrews and Phillips), but spread and wander are those of weak turbulence"),
        ("Turbulence fade (dB): scintillation index 0.411, wander of 6.47 µrad rms; exceeded for 1 % of the time "
         "| mission file, line 33; mission file, line 34; mission file, line 35; mission file, line 65 | any "
         "strength, by its index | "),
        ("Fried's parameter (m): (0.423 k^2 times the integral of Cn2)^(-3/5), at 20 deg of elevation | mission "
         "file, line 33; mission file, line 34 | Kolmogorov's turbulence, flat air | "),
        ("Isoplanatic angle (rad): (2.914 k^2 times that of Cn2 z^(5/3))^(-3/5) | mission file, line 33; mission "
         "file, line 34 | Kolmogorov's turbulence, flat air | "),
        ("Greenwood frequency (Hz): (0.102 k^2 times that of Cn2 v^(5/3))^(3/5), in air that the satellite does "
         "not turn through | mission file, line 33; mission file, line 34 | Kolmogorov's turbulence, flat air | "),
        ("Rytov variance (): 2.25 k^(7/6) times the integral of Cn2 z^(5/6) | mission file, line 33; mission "
         "file, line 34 | plane wave | "),
        ("Scintillation index (): plane wave, averaged over the aperture | mission file, line 33; mission file, "
         "line 34 | any strength | "),
        ("Angle of arrival (rad): rms about one axis, zernike | mission file, line 33; mission file, line 34 | "
         "Kolmogorov's turbulence, flat air | "),
        ("Scintillation index (): Gaussian beam on its axis | mission file, line 33; mission file, line 34 | any "
         "strength | moderate turbulence: the Rytov variance is 0.454, above 0.3; an index is that for any "
         "strength (Andrews and Phillips), but spread and wander are those of weak turbulence"),
        ("Beam wander (rad): radial rms, dios-2004 | mission file, line 33; mission file, line 34 | Kolmogorov's "
         "turbulence, flat air | "),
    ]),
    ("up", [
        ("Turbulence spread loss (dB): 12 lg(1 + (D0 / r0)^(5/3)), D0 = sqrt(8) W0, r0 = 111 mm, or what 7 "
         "corrected modes and the point-ahead angle leave, if that is less | mission file, line 33; mission "
         "file, line 34; mission file, line 38 | mean power on the axis, wander in it (Andrews and Phillips 2005) | "
         "the point-ahead angle is 7.8 isoplanatic angles: adaptive optics measures other air than the beam goes "
         "through"),
        ("Turbulence fade (dB): scintillation index 0.19, wander of 6.08 µrad rms; what it adds to the pointing "
         "loss, all together exceeded for 1 % of the time | mission file, line 33; mission file, line 34; "
         "mission file, line 35; mission file, line 62 | any strength, by its index | "),
        ("Turbulence fade (dB): scintillation index 0.292; exceeded for 1 % of the time | mission file, line 33; "
         "mission file, line 34; mission file, line 35; mission file, line 62 | any strength, by its index | "
         "moderate turbulence: the Rytov variance is 0.454, above 0.3; an index is that for any strength "
         "(Andrews and Phillips), but spread and wander are those of weak turbulence"),
    ]),
    ("disk", [
        ("Turbulence coupling loss (dB): mean power into the detector, r0 = 111 mm, 4 modes corrected | mission "
         "file, line 33; mission file, line 34; mission file, line 38 | Kolmogorov's turbulence, what correction "
         "leaves of it | "),
        ("Turbulence fade (dB): scintillation index 0.0335; what it adds to the pointing loss, all together "
         "exceeded for 1 % of the time | mission file, line 33; mission file, line 34; mission file, line 35; "
         "mission file, line 66 | any strength, by its index | "),
        ("Turbulence spread loss (dB): 12 lg(1 + (D0 / r0)^(5/3)), D0 = sqrt(8) W0, r0 = 70.5 mm, or what 4 "
         "corrected modes and the point-ahead angle leave, if that is less | mission file, line 33; mission "
         "file, line 34; mission file, line 38 | mean power on the axis, wander in it (Andrews and Phillips 2005) | "
         "moderate turbulence: the Rytov variance is 0.454, above 0.3; an index is that for any strength (Andrews and "
         "Phillips), but spread and wander are those of weak turbulence; the point-ahead angle is 12 isoplanatic "
         "angles: adaptive optics measures other air than the beam goes through"),
        ("Turbulence fade (dB): scintillation index 0.411, wander of 6.47 µrad rms; exceeded for 1 % of the time "
         "| mission file, line 33; mission file, line 34; mission file, line 35; mission file, line 66 | any "
         "strength, by its index | "),
    ]),
])  # fmt: skip
def test_lines_of_the_air_say_what_they_are_and_where_they_come_from(unlike, case, expected):
    lines = lines_with_air(unlike(case))
    written = {f"{x.name} ({x.unit}): {x.basis} | {x.source} | {x.regime} | {x.warning}" for x in lines}
    assert not set(expected) - written


@pytest.mark.parametrize("shaken", [{}, {"jitter": None}], ids=["jitter", "still"])
@pytest.mark.parametrize("table", [PHOTODIODE, FIBRE], ids=["detector", "fibre"])
def test_a_receiver_that_points_badly_all_the_time_loses_as_much_of_each_fade(tmp_path, table, shaken):
    def found(*error):
        coupled = {"communication.coupling": table | dict(error)}
        data = link.of(ground_file(tmp_path, coupled, shaken).mission)
        return data, outage.Exposure.stated(data)

    (good, without), (bad, pointed) = found(), found(("pointing_error", "1.5 urad"))
    lost = bad.receiving.end.worst_loss_db(1.5e-6) - float(bad.receiving.end.loss_db(0.0))
    assert lost > 0.01 and bad.receive_pointing_db == pytest.approx(lost, abs=1e-12)
    assert bad.fade_db == pytest.approx(good.fade_db, abs=1e-9) and good.fade_db > 0.1
    assert without.margin_db - pointed.margin_db == pytest.approx(lost, abs=1e-9)
    assert pointed.received_mean_db - without.received_mean_db == pytest.approx(lost, abs=1e-9)
    for margin_db in (without.margin_db - 3.0, without.margin_db - 0.5):
        assert pointed.short_of(margin_db - lost) == pytest.approx(without.short_of(margin_db), rel=1e-9)


def test_the_margin_of_an_answer_through_the_air_moves_with_all_that_it_goes_through(tmp_path):
    changes = TYPED, {"channel.station": "leo", "point_ahead.corrected": False}, STATIC
    file = ground_file(tmp_path, *changes)
    found = {each.key: each for each in beam_tornado(file.mission, file.sources, "answer")}
    keys = {f"answer.{key}" for key in ("wavelength", "divergence", "pointing_error", "wavefront_error")}
    keys |= {f"answer.{key}" for key in ("transmit_power", "required_power")}
    keys |= {f"answer.{key}" for key in ("transmit_optics_loss", "receive_optics_loss")}
    keys |= {f"channel.{key}" for key in ("absorption", "aerosol_depth", "angstrom_exponent")}
    keys |= {f"channel.{key}" for key in ("elevation", "altitude", "height")}
    keys |= {f"channel.turbulence.{key}" for key in ("ground_strength", "wind_rms")}
    keys |= {"terminals.leo_aperture", "point_ahead.transverse_velocity", "requirement.outage"}
    assert found.keys() == keys
    outage_of = file.mission.requirement.outage
    assert (found["requirement.outage"].low, found["requirement.outage"].high) == pytest.approx(
        (outage_of / 10.0, outage_of * 10.0), rel=1e-12
    )
    for key, unit, scale in (
        ("requirement.outage", None, 1.0),
        ("channel.elevation", "deg", 1.0 / deg),
        ("channel.altitude", "m", 1.0),
        ("channel.turbulence.wind_rms", "m/s", 1.0),
        ("point_ahead.transverse_velocity", "m/s", 1.0),
    ):
        each = found[key]
        for value, margin_db in ((each.low, each.margin_low_db), (each.high, each.margin_high_db)):
            given = value if unit is None else f"{value * scale!r} {unit}"
            m = ground_file(tmp_path, *changes, {key: given}).mission
            moved = link.beam_budget("answer", link.Shared.of(m), m.answer, {}).margin_db
            assert moved == pytest.approx(margin_db, abs=1e-8), key


BEACON = {
    "transmit_power": "2 W",
    "wavelength": "0.85 um",
    "divergence": "300 urad",
    "strehl": 0.9,
    "pointing_error": "30 urad",
    "transmit_optics_loss": "0.5 dB",
    "receive_optics_loss": "0.7 dB",
    "required_power": "10 pW",
}


def wander_by_hand(path, waist_m):
    rayleigh_m = math.pi * waist_m**2 / path.wavelength_m

    def shape(z):
        return (1.0 - z / path.range_m) ** 2 * (waist_m * math.hypot(1.0, z / rayleigh_m)) ** (-1.0 / 3.0)

    return math.sqrt(2.07 * path.over(shape))


@pytest.mark.parametrize(("changes", "upwards"), [((), {"Answer"}), ((UP,), {"Communication", "Beacon"})])
def test_each_of_three_beams_has_its_own_air_downwards_or_upwards(tmp_path, monkeypatch, changes, upwards):
    """Figures by the wavelength, the receiving aperture and the divergence of each."""
    monkeypatch.setattr(ground, "_CONVENTIONS", ("fades",))
    monkeypatch.setattr(ground, "_ELEVATIONS_DEG", ())
    log_normal = {"channel.turbulence.fades": "log-normal", "jitter": None}
    file = ground_file(tmp_path, *changes, log_normal, {"beacon": BEACON, "communication.coupling": None})
    m = file.mission
    g = ground_link(m, file.sources, link.of(m))
    assert [name for name, _ in g.beams] == ["Communication", "Beacon", "Answer"]
    apertures = {"Communication": 0.4, "Beacon": 0.4, "Answer": 0.05}
    for name, lines in g.beams:
        of = {line.name: line.value for line in lines}
        wavelength = getattr(m, name.lower()).wavelength_m
        path = Path(wavelength, m.path.elevation_rad)
        assert of["Fried's parameter"] == pytest.approx(path.r0, rel=1e-6)
        if name in upwards:
            assert "Angle of arrival" not in of
            half = {"Beacon": 150e-6, "Answer": 100e-6}.get(name, link.of(m).beam.fall.half_angle_rad)
            waist = wavelength / (math.pi * half)
            assert of["Beam wander"] == pytest.approx(wander_by_hand(path, waist), rel=1e-5)
        else:
            assert "Beam wander" not in of
            diameter = apertures[name]
            arrival = math.sqrt(0.18164 * (diameter / path.r0) ** (5.0 / 3.0)) * wavelength / diameter
            assert of["Angle of arrival"] == pytest.approx(arrival, rel=1e-6)
    (fades,) = g.conventions
    other = ground_file(tmp_path, *changes, log_normal, {"beacon": BEACON, "communication.coupling": None}, {
        fades.key: fades.other}).mission  # fmt: skip
    assert list(fades.gained_db) == ["Communication", "Beacon", "Answer"]
    for name in ("beacon", "answer"):
        was, now = (
            link.beam_budget(name, link.Shared.of(each), getattr(each, name), {}).margin_db for each in (m, other)
        )
        assert fades.gained_db[name.capitalize()] == pytest.approx(now - was, abs=1e-9)
    assert len({round(gained, 6) for gained in fades.gained_db.values()}) == 3


@pytest.mark.parametrize(("velocity", "modes", "doubted"), [(7500.0, 7, True), (300.0, 7, False), (7500.0, 0, False)])
def test_adaptive_optics_that_measures_other_air_is_doubted_of_an_uplink_alone(tmp_path, velocity, modes, doubted):
    changes = {"channel.turbulence.corrected_modes": modes, "point_ahead.transverse_velocity": f"{velocity} m/s"}
    m = ground_file(tmp_path, changes).mission
    shared = link.Shared.of(m)
    path = Path(m.answer.wavelength_m, m.path.elevation_rad)
    isoplanatic = (2.914 * path.k**2 * path.over(lambda z: z ** (5.0 / 3.0))) ** -0.6
    angle = 2.0 * velocity / LIGHT_M_S
    assert (angle > isoplanatic) is (velocity > 1e3)
    found = [each for each in shared.turbulent(m.answer, "geo", 100e-6, None).doubts if "point-ahead" in each]
    said = f"the point-ahead angle is {angle / isoplanatic:.2g} isoplanatic angles: adaptive optics measures other air"
    assert found == ([f"{said} than the beam goes through"] if doubted else [])
    assert not any("point-ahead" in each for each in link.of(m).turbulent.doubts)


@pytest.mark.parametrize(("table", "modes", "doubted"), [
    (FIBRE, 3, True),
    (FIBRE, 0, False),
    (FIBRE, 200, False),
    (PHOTODIODE, 3, False),
    (PHOTODIODE, 4, True),
])  # fmt: skip
def test_a_correction_that_leaves_more_than_a_radian_is_doubted_where_it_counts(tmp_path, table, modes, doubted):
    """Piston and tilts are no correction to a disk, which follows them: its own closed form holds."""
    still = {"jitter": None, "terminals.geo_aperture": "1.2 m"}
    m = ground_file(tmp_path, STATIC, still, {
        "communication.coupling": table, "channel.turbulence.corrected_modes": modes}).mission  # fmt: skip
    over = (1.2 / Path(1.55e-6, m.path.elevation_rad).r0) ** (5.0 / 3.0)
    noll = {0: 1.0299, 3: 0.134, 4: 0.111, 200: 0.2944 * 200.0 ** (-math.sqrt(3.0) / 2.0)}
    left = noll[modes] * over
    found = [each for each in link.of(m).turbulent.doubts if "Marechal" in each]
    assert found == ([f"a residual of {math.sqrt(left):.2g} rad rms, above 1: Marechal's ends"] if doubted else [])
    assert (left > 1.0) is (modes < 100)


def test_a_beam_down_to_the_station_that_sends_the_data_fades_as_over_its_own_aperture(tmp_path):
    """The satellite, whose aperture is another one, answers."""
    m = ground_file(tmp_path, RISING).mission
    shared, half_rad = link.Shared.of(m), m.answer.divergence_rad
    found = shared.turbulent(m.answer, "geo", half_rad, None)
    down, tilt = Downlink(found.path), m.channel.turbulence.tilt
    assert (m.path.station, found.direction) == ("leo", "downlink")
    assert found.index == pytest.approx(down.index(0.12), rel=1e-12)
    assert found.arrival_rad == pytest.approx(down.arrival_rms_rad(0.12, tilt), rel=1e-12)
    assert abs(down.index(0.08) / found.index - 1.0) > 0.1


@pytest.mark.parametrize("changes", [(RISING,), ({"communication.coupling": FIBRE},)], ids=["up", "down"])
def test_the_air_of_a_link_is_the_clear_sky_with_what_a_wider_beam_or_a_bent_wavefront_costs(tmp_path, changes):
    file = ground_file(tmp_path, *changes)
    found = lines_of(link.communication_budget(link.of(file.mission), file.sources))
    names = {"Clear-sky loss", "Turbulence spread loss", "Turbulence coupling loss"} & found.keys()
    assert len(names) == 2 and all(found[name] < -0.01 for name in names)
    assert link.of(file.mission).air_db == pytest.approx(-sum(found[name] for name in names), rel=1e-9)
