"""From the tables of a mission to its margin: receivers, lines and map against each other and against formulas."""

import dataclasses
import math
import re
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from scipy.integrate import quad
from scipy.special import j0

import budgets
from link_files import GAUSSIAN, PATTERN, RECEIVERS, SKY, link_file, received_with
from microrad import link
from microrad.core.units import PLANCK_J_S, SPEED_OF_LIGHT_M_S
from microrad.link import beams, gains, receivers
from microrad.link import study as link_study
from microrad.link.budget import lines, maps
from microrad.link.budget.lines import LEFT_AT_ZERO
from microrad.mission.tables.coupling import Coupling
from microrad.mission.tables.link import half_angle_rad

WAVELENGTH, RATE = 1.55e-6, 300e6
PHOTON_J = PLANCK_J_S * SPEED_OF_LIGHT_M_S / WAVELENGTH
COMMON = {
    "wavelength_m": WAVELENGTH,
    "bit_error_ratio": 1e-6,
    "bandwidth_hz": 4e9,
    "code_gain_db": 5.0,
    "code_rate": 0.8,
}
COUNTER = {"detection_efficiency": 0.4, "dark_count_rate_hz": 2000.0, "background_power_w": 1e-12}
DIODE = {
    "quantum_efficiency": 0.8,
    "thermal_noise_a_sqrt_hz": 2e-12,
    "dark_current_a": 1e-9,
    "background_power_w": 1e-11,
    "extinction_ratio": 100.0,
}
BUILT = {
    "homodyne bpsk": receivers.BpskHomodyne(**COMMON, quantum_efficiency=0.7),
    "heterodyne bpsk": receivers.BpskHeterodyne(**COMMON, quantum_efficiency=0.7, phase_error_rad=0.2),
    "homodyne qpsk": receivers.QpskHomodyne(**COMMON, quantum_efficiency=0.7, polarisations=2),
    "heterodyne qpsk": receivers.QpskHeterodyne(
        **COMMON, quantum_efficiency=0.7, phase_error_rad=math.radians(5.0), polarisations=2
    ),
    "preamplified dpsk": receivers.DpskPreamplified(**COMMON, noise_figure_db=4.0),
    "preamplified ook": receivers.OokPreamplified(
        **COMMON, noise_figure_db=4.0, gain_db=35.0, optical_bandwidth_hz=20e9, extinction_ratio=100.0
    ),
    "counting ppm": receivers.PpmCounting(**COMMON, **COUNTER, order=16),
    "counting ook": receivers.OokCounting(**COMMON, **COUNTER, extinction_ratio=100.0),
    "pin ook": receivers.OokPin(**COMMON, **DIODE),
    "apd ook": receivers.OokApd(**COMMON, **DIODE, gain=20.0, ionisation_ratio=0.2),
}
UNCORRECTED = {"point_ahead.corrected": False}
CHANNEL = {"channel": {"zenith_transmission": 0.8, "elevation": "30 deg"}}
HOLES = {"terminals.leo_obscuration": 0.2, "terminals.geo_obscuration": 0.3}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("links")


@pytest.fixture
def read(folder):
    return lambda *changes: link_file(folder, *changes)


def line_of(budget, name):
    return next(line for line in (*budget.lines, *budget.totals) if line.name == name)


def budget_of(file, *point):
    return budgets.communication(file.mission, file.sources, *point)


# ---- receivers
@pytest.mark.promise("choose-10")
@pytest.mark.promise("link-22")
@pytest.mark.parametrize("name", RECEIVERS)
def test_each_receiver_of_a_file_is_the_record_of_its_values(read, name):
    file = read(received_with(name))
    built = link.of(file.mission).receiver
    assert type(built) is type(BUILT[name])
    for key, expected in dataclasses.asdict(BUILT[name]).items():
        close = expected if expected is None else pytest.approx(expected, rel=1e-12, abs=0.0)
        assert getattr(built, key) == close, key
    expected = float(BUILT[name].required_power_w(RATE))
    budget = budget_of(file)
    assert budget.required_power_w == pytest.approx(expected, rel=1e-9, abs=0.0)
    assert float(link.required_dbm(link.of(file.mission), RATE)) == pytest.approx(
        10 * math.log10(expected * 1e3), abs=1e-9
    )
    line = line_of(budget, "Required power")
    assert f"{RECEIVERS[name]['modulation'].upper()}, {RECEIVERS[name]['detector']}" in line.basis
    assert f"{expected / PHOTON_J / RATE:.4g} photon/bit at a bit error ratio of 1e-06, code gain 5 dB" in line.basis
    assert float(built.bit_error_ratio_at(expected, RATE)) == pytest.approx(1e-6, rel=1e-3, abs=0.0)


def test_every_pair_of_the_table_is_built():
    assert set(BUILT) == set(RECEIVERS)


@pytest.mark.promise("choose-10")
@pytest.mark.promise("link-22")
def test_a_measured_sensitivity_is_no_receiver(read):
    file = read()
    assert link.of(file.mission).receiver is None
    assert budget_of(file).required_power_w == pytest.approx(291.2 * PHOTON_J * RATE, rel=1e-9, abs=0.0)


@pytest.mark.promise("link-27")
@pytest.mark.parametrize("name", ["counting ook", "counting ppm", "pin ook", "apd ook"])
def test_a_sky_comes_through_aperture_field_filter_and_optics(read, name):
    sky = received_with(name, background=SKY, background_power=None)
    file = read(sky, HOLES, {"communication.receive_optics_loss": "2 dB", "communication.tracking_split_loss": "1 dB"})
    area = math.pi / 4 * 0.15**2 * (1 - 0.3**2)
    solid_angle = math.pi * (50e-6) ** 2
    # 10 W/(m^2 sr um) over 1 nm
    expected = 10e6 * 1e-9 * area * solid_angle * 10**-0.3
    assert link.of(file.mission).receiver.background_power_w == pytest.approx(expected, rel=1e-6, abs=0.0)


@pytest.mark.promise("link-27")
@pytest.mark.parametrize(
    "name", ["homodyne bpsk", "heterodyne bpsk", "homodyne qpsk", "preamplified dpsk", "preamplified ook"]
)
def test_a_sky_is_photons_in_a_mode_behind_the_optics(read, name):
    file = read(received_with(name, background=SKY), {"communication.receive_optics_loss": "3 dB"})
    expected = 10e6 * WAVELENGTH**5 / (2 * PLANCK_J_S * SPEED_OF_LIGHT_M_S**2) * 10**-0.3
    assert link.of(file.mission).receiver.background_photons_per_mode == pytest.approx(expected, rel=1e-9, abs=0.0)


@pytest.mark.parametrize("name", RECEIVERS)
def test_a_rate_above_the_bandwidth_is_refused_with_the_highest(read, name):
    file = read(received_with(name))
    highest = link.of(file.mission).receiver.highest_data_rate_bit_s
    bits = RECEIVERS[name].get("polarisations", 1) * (2 if RECEIVERS[name]["modulation"] == "qpsk" else 1)
    limit = 4e9 * 0.8 / 4 if name == "counting ppm" else 4e9 * 0.8 * bits
    assert highest == pytest.approx(limit, rel=1e-12)
    assert math.isfinite(budget_of(file, 1e-5, highest).margin_db)
    shown = {"counting ppm": "800 Mbit/s", "homodyne qpsk": "12.8 Gbit/s", "heterodyne qpsk": "12.8 Gbit/s"}
    said = re.escape(f"so at most {shown.get(name, '3.2 Gbit/s')} of data")
    with pytest.raises(ValueError, match=said):
        budget_of(file, 1e-5, highest * 1.001)
    with pytest.raises(ValueError, match=said):
        link.margin_map(link.of(file.mission), [RATE, highest * 1.001], [0.0])


# ---- lines and map: the same formula, written twice
SHAPES = [{}, {"conventions.pointing_loss": "gain"}, PATTERN]
SHAPES += [{**PATTERN, "communication.beam": {"profile": "uniform"}}]
QUALITY = [
    {},
    {"conventions.strehl": "ratio"},
    {"communication.strehl": None, "communication.wavefront_error": "90 nm"},
]


ENDS = ("leo", "geo")


@st.composite
def links(draw):
    """A link of any shape, receiver, channel and losses, and a point of its map."""
    losses = ("transmit_optics", "receive_optics", "tracking_split", "implementation")
    changes = [
        draw(st.sampled_from(SHAPES)),
        draw(st.sampled_from(QUALITY)),
        draw(st.sampled_from([{}, CHANNEL])),
        draw(st.sampled_from([{}, UNCORRECTED, {"point_ahead": None}])),
        {f"communication.{each}_loss": f"{draw(st.floats(0.0, 10.0)):.3f} dB" for each in losses},
        {"communication.distance": f"{draw(st.floats(500.0, 45000.0)):.1f} km"},
        {"terminals.leo_aperture": f"{draw(st.floats(1.0, 20.0)):.3f} cm"},
    ]
    changes += [draw(st.sampled_from([{}, {f"terminals.{e}_obscuration": 0.2 * draw(st.floats(0, 1))}])) for e in ENDS]
    name = draw(st.sampled_from([None, *RECEIVERS]))
    changes.append({} if name is None else received_with(name))
    return changes, draw(st.floats(0.0, 100e-6)), draw(st.floats(1e6, 7e8))


@settings(deadline=None, max_examples=50, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(links())
def test_the_lines_add_up_to_the_margin_of_the_map(folder, drawn):
    changes, error, rate = drawn
    file = link_file(folder, *changes)
    budget = budget_of(file, error, rate)
    assert budget.margin_db == pytest.approx(float(link.margin_map(link.of(file.mission), rate, error)[0, 0]), abs=1e-8)
    received = math.fsum(line.value for line in budget.lines)
    assert budget.received_power_w == pytest.approx(10 ** (received / 10 - 3), rel=1e-8, abs=1e-300)
    assert 0.0 <= budget.required_irradiance_w_m2 < math.inf
    assert budget.margin_db == pytest.approx(received - line_of(budget, "Required power").value, abs=1e-8)
    assert all(math.isfinite(line.value) for line in (*budget.lines, *budget.totals))
    assert not any(line.value == 0.0 and math.copysign(1.0, line.value) < 0.0 for line in budget.lines)
    assert all("not stated" not in line.source for line in (*budget.lines, *budget.totals))
    assert len({line.name for line in budget.lines}) == len(budget.lines)


@pytest.mark.parametrize(
    "change", [{}, PATTERN, received_with("apd ook"), {**PATTERN, **received_with("counting ppm")}]
)
def test_a_whole_map_is_the_budget_at_any_of_its_points(read, change):
    file = read(change, CHANNEL, UNCORRECTED, {"point_ahead.transverse_velocity": "1 km/s"})
    rates, errors = np.geomspace(1e6, 7e8, 1000), np.linspace(0.0, 50e-6, 1000)
    margins = link.margin_map(link.of(file.mission), rates, errors)
    assert margins.shape == (1000, 1000)
    for i, j in ((0, 0), (0, 999), (999, 0), (999, 999), (317, 211), (640, 873)):
        assert margins[i, j] == pytest.approx(budget_of(file, errors[j], rates[i]).margin_db, abs=1e-6)


@pytest.mark.promise("link-14")
def test_a_link_through_everything_is_what_the_formulas_say(read):
    file = read(
        PATTERN,
        HOLES,
        CHANNEL,
        UNCORRECTED,
        {"point_ahead.transverse_velocity": "1 km/s", "communication.pointing_error": "3 urad"},
        {"communication.strehl": None, "communication.wavefront_error": "100 nm"},
        {"communication.transmit_optics_loss": "1.5 dB", "communication.receive_optics_loss": "2 dB"},
        received_with("preamplified dpsk"),
    )
    a, e, quality = 2.5 / 2, 0.2, 1.2

    def field(error):
        x = math.pi * 0.05 * error / WAVELENGTH / quality
        return quad(lambda r: math.exp(-((a * r) ** 2)) * j0(x * r) * r, e, 1.0)[0]

    error = 3e-6 + 2 * 1e3 / SPEED_OF_LIGHT_M_S
    gain = (math.pi * 0.05 / WAVELENGTH) ** 2 * 8 * a**2 * field(error) ** 2 / quality**2
    received = (
        5.0
        * gain
        * (math.pi * 0.15 / WAVELENGTH) ** 2
        * (1 - 0.3**2)
        * (WAVELENGTH / (4 * math.pi * 42e6)) ** 2
        * math.exp(-((2 * math.pi * 100e-9 / WAVELENGTH) ** 2))
        * 0.8 ** (1 / (0.5 + 0.50572 * 36.07995**-1.6364))
        * 10**-0.35
    )
    required = 10**0.4 / 2 * math.log(0.5 / 1e-6) * PHOTON_J * RATE / 10**0.5
    budget = budget_of(file)
    assert budget.received_power_w == pytest.approx(received, rel=1e-6, abs=0.0)
    assert budget.required_power_w == pytest.approx(required, rel=1e-9, abs=0.0)
    names = [line.name for line in budget.lines]
    assert names == [
        "Transmit power",
        "LEO aperture gain",
        "Illumination",
        "Transmit optics loss",
        "Strehl loss",
        "Pointing loss",
        "Point-ahead loss",
        "Free-space loss",
        "Clear-sky loss",
        "GEO aperture gain",
        "GEO obscuration loss",
        "Receive optics loss",
        "Tracking split loss",
        "Implementation loss",
        "Inter-symbol loss",
    ]
    area = math.pi * 0.15**2 / 4 * (1 - 0.3**2)
    assert budget.irradiance_w_m2 * area * 10**-0.2 == pytest.approx(budget.received_power_w, rel=1e-9, abs=0.0)
    assert budget.required_irradiance_w_m2 * area * 10**-0.2 == pytest.approx(
        budget.required_power_w, rel=1e-9, abs=0.0
    )


@pytest.mark.promise("link-4", "link-20")
def test_without_a_channel_there_is_vacuum_and_without_an_obscuration_none(read):
    for make in (budgets.communication, budgets.beacon, budgets.answer):
        plain, through = (make(each.mission, each.sources) for each in (read(), read(CHANNEL)))
        assert "Clear-sky loss" not in {line.name for line in plain.lines}
        assert line_of(through, "Clear-sky loss").value < -1.9
        assert through.margin_db - plain.margin_db == pytest.approx(line_of(through, "Clear-sky loss").value, abs=1e-9)
    terminals = read().mission.terminals
    assert (terminals.leo_obscuration, terminals.geo_obscuration) == (None, None)
    assert (terminals.called("leo"), terminals.called("geo")) == ("LEO", "GEO")


@pytest.mark.promise("link-14")
def test_obscurations_are_lines_of_the_terminal_that_receives(read):
    file = read(HOLES, {"terminals.leo_name": "Cubesat", "terminals.geo_name": "Relay"})
    assert line_of(budgets.beacon(file.mission, file.sources), "Relay obscuration loss").value == pytest.approx(
        10 * math.log10(1 - 0.3**2)
    )
    assert line_of(budgets.answer(file.mission, file.sources), "Cubesat obscuration loss").value == pytest.approx(
        10 * math.log10(1 - 0.2**2)
    )
    assert not any("obscuration" in line.name for line in budget_of(read()).lines)


@pytest.mark.promise("link-14")
def test_an_even_light_behind_an_obscuration_has_its_open_area(read):
    beam = {**PATTERN, "communication.beam": {"profile": "uniform"}, **HOLES}
    assert line_of(budget_of(read(beam)), "Illumination").value == pytest.approx(10 * math.log10(1 - 0.2**2))
    plain = {**beam, "terminals.leo_obscuration": 0.0}
    assert line_of(budget_of(read(plain)), "Illumination").value == 0.0


@pytest.mark.promise("link-44")
def test_point_ahead_left_in_the_error_costs_what_it_adds_there(read):
    corrected, left = read(), read(UNCORRECTED)
    angle = 2 * 10.65e3 / SPEED_OF_LIGHT_M_S
    assert link.of(corrected.mission).shared.point_ahead_rad == 0.0
    assert link.of(left.mission).shared.point_ahead_rad == pytest.approx(angle, rel=1e-12)
    assert link.of(read({"point_ahead": None}).mission).shared.point_ahead_rad == 0.0
    half = 2 * WAVELENGTH / (math.pi * 0.05)
    cost = 8.685889638 * (((10e-6 + angle) / half) ** 2 - (10e-6 / half) ** 2)
    assert line_of(budget_of(left), "Point-ahead loss").value == pytest.approx(-cost, rel=1e-9)
    assert line_of(budget_of(corrected), "Point-ahead loss").value == 0.0
    assert budget_of(corrected).margin_db - budget_of(left).margin_db == pytest.approx(cost, rel=1e-9)
    assert budget_of(left).irradiance_on_axis_w_m2 == pytest.approx(
        budget_of(corrected).irradiance_on_axis_w_m2, rel=1e-9
    )
    both = [budgets.answer(f.mission, f.sources).margin_db for f in (corrected, left)]
    theta = 20e-6
    assert both[0] - both[1] == pytest.approx(
        8.685889638 * (((10e-6 + angle) / theta) ** 2 - (10e-6 / theta) ** 2), rel=1e-9
    )


def test_a_mission_without_beacon_or_answer_says_so(read):
    file = read({"beacon": None, "answer": None, "acquisition": None})
    with pytest.raises(ValueError, match=r"the mission has no table \[beacon\]"):
        budgets.beacon(file.mission, file.sources)
    with pytest.raises(ValueError, match=r"the mission has no table \[answer\]"):
        budgets.answer(file.mission, file.sources)
    study = link_study.run_link_study(file)
    assert (study.beacon, study.answer, study.finding, study.tracking) == (None, None, None, None)
    assert study.budgets == (study.communication,)


# ---- warnings
def warned(budget, word):
    return [each for each in budget.warnings if word in each]


@pytest.mark.promise("link-9")
def test_terms_left_at_zero_are_said_in_one_warning(read):
    budget = budget_of(
        read({"communication.strehl": 0.0, "point_ahead": None, "communication.tracking_split_loss": "1 dB"})
    )
    names = ("Transmit optics loss", "Strehl loss", "Point-ahead loss", "Receive optics loss", "Implementation loss")
    assert budget.at_zero == names
    assert budget.warnings == (
        f"Communication budget: {LEFT_AT_ZERO}: {', '.join(names)}; what the hardware has comes off the margin",
    )
    losses = {f"communication.{key}_loss": "1 dB" for key in ("transmit_optics", "receive_optics", "implementation")}
    assert budget_of(read(losses, {"communication.tracking_split_loss": "1 dB"})).warnings == ()


@pytest.mark.promise("link-9")
def test_a_link_nearer_than_the_far_field_is_warned_of(read):
    begins = 2 * 0.15**2 / WAVELENGTH
    near, far = ({"communication.distance": f"{begins * f / 1e3:.6f} km"} for f in (0.999, 1.001))
    found = warned(budget_of(read(near)), "far field")
    assert found == ["Communication budget: Free-space loss: nearer than the far field, which begins at 29.03 km"]
    assert not warned(budget_of(read(far)), "far field")


@pytest.mark.promise("link-9")
@pytest.mark.parametrize(("link_name", "diameter"), [("beacon", 0.05), ("answer", 0.15)])
def test_a_beam_wider_than_its_aperture_is_warned_of(read, link_name, diameter):
    # (1 - exp(-a^2))^2 is 0.1 dB at a truncation of 2.116
    full = 2 * 2.116 * WAVELENGTH / (math.pi * diameter / 2)
    budget = {"beacon": budgets.beacon, "answer": budgets.answer}[link_name]
    for share, wide in ((0.99, True), (1.01, False)):
        file = read(
            {f"{link_name}.divergence": f"{full * share * 1e6:.6f} urad", f"{link_name}.pointing_error": "1 urad"}
        )
        assert bool(warned(budget(file.mission, file.sources), "cuts it: 0.1")) == wide


@pytest.mark.promise("link-9")
@pytest.mark.parametrize(("change", "line"), [({}, "Pointing loss"), (UNCORRECTED, "Point-ahead loss")])
def test_a_pointing_loss_beyond_twenty_decibels_is_warned_of(read, change, line):
    half = 2 * WAVELENGTH / (math.pi * 0.05)
    ahead = 2 * 1e3 / SPEED_OF_LIGHT_M_S if change else 0.0
    for loss, deep in ((20.1, True), (19.9, False)):
        error = half * math.sqrt(loss / 8.685889638) - ahead
        file = read(change, {"point_ahead.transverse_velocity": "1 km/s"})
        found = warned(budget_of(file, error), f"{line}: beyond 20 dB the wings and the scatter")
        assert bool(found) == deep


@pytest.mark.promise("link-9")
def test_a_strehl_beyond_five_decibels_is_warned_of(read):
    for loss, bad in ((5.1, True), (4.9, False)):
        assert bool(warned(budget_of(read({"communication.strehl": loss})), "no core to speak of")) == bad


@pytest.mark.promise("link-20")
def test_turbulence_is_said_to_be_missing(read):
    assert warned(budget_of(read(CHANNEL)), "turbulence is not in this budget")
    assert not warned(budget_of(read()), "turbulence")


@pytest.mark.promise("link-14")
def test_an_obscuration_that_a_reading_leaves_out_is_warned_of(read):
    found = warned(budget_of(read(HOLES)), "the obscuration of 0.2 is not in it")
    assert len(found) == 1
    assert "LEO aperture gain" in found[0]
    assert not warned(budget_of(read(HOLES, PATTERN)), "is not in it")
    assert not warned(budget_of(read({"terminals.leo_obscuration": 0.0})), "is not in it")


@pytest.mark.promise("link-14")
@pytest.mark.parametrize(("name", "end", "other"), [("beacon", "leo", "geo"), ("answer", "geo", "leo")])
def test_an_obscuration_of_the_terminal_that_sends_a_gaussian_beam_is_warned_of(read, name, end, other):
    budget = {"beacon": budgets.beacon, "answer": budgets.answer}[name]

    def found(*changes):
        file = read(*changes)
        return warned(budget(file.mission, file.sources), "is not in it")

    (said,) = found({f"terminals.{end}_obscuration": 0.5})
    assert said.startswith(f"{name.capitalize()} budget: Beam gain: the obscuration of 0.5 is not in it")
    assert "transmit_optics_loss" in said
    assert len(found({f"terminals.{end}_obscuration": 0.5}, PATTERN)) == 1  # that is of the data's beam
    for hole in ({f"terminals.{other}_obscuration": 0.5}, {f"terminals.{end}_obscuration": 0.0}, {}):
        assert not found(hole)


def test_a_beam_that_is_cut_and_obscured_is_warned_of_both(read):
    narrow = {"answer.divergence": "25 urad", "answer.pointing_error": "1 urad", "terminals.geo_obscuration": 0.3}
    file = read(narrow)
    (said,) = warned(budgets.answer(file.mission, file.sources), "Beam gain")
    assert "cuts it: 0." in said
    assert "wider core; the obscuration of 0.3 is not in it" in said


@pytest.mark.promise("link-9")
@pytest.mark.parametrize("name", ["beacon", "answer"])
def test_a_beam_and_an_error_that_are_no_small_angles_are_warned_of(read, name):
    budget = {"beacon": budgets.beacon, "answer": budgets.answer}[name]
    for milliradians, wide in ((100.1, True), (99.9, False)):
        file = read({f"{name}.divergence": f"{2 * milliradians} mrad", f"{name}.pointing_error": "1 mrad"})
        found = warned(budget(file.mission, file.sources), "Beam gain: the half angle of")
        assert bool(found) == wide
        assert all("is above 0.1 rad, where small angles end" in each for each in found)
        file = read({f"{name}.divergence": "190 mrad", f"{name}.pointing_error": f"{milliradians} mrad"})
        assert bool(warned(budget(file.mission, file.sources), "Pointing loss: the error of")) == wide


@pytest.mark.promise("link-9")
@pytest.mark.parametrize("how", [{}, PATTERN, {"conventions.pointing_loss": "gain"}], ids=["w", "pattern", "gain"])
def test_an_error_of_the_data_link_that_is_no_small_angle_is_warned_of_beside_its_depth(read, how):
    for milliradians, wide in ((100.1, True), (99.9, False)):
        (said,) = warned(budget_of(read(how), milliradians * 1e-3), "Pointing loss")
        assert ("the error of 100 mrad is above 0.1 rad, where small angles end; beyond 20 dB" in said) == wide
        assert "beyond 20 dB" in said


@pytest.mark.parametrize("lit", [{}, {**PATTERN, "communication.beam": {"profile": "uniform"}}], ids=["w", "pattern"])
def test_an_aperture_so_small_that_its_beam_is_no_small_angle_is_warned_of(read, lit):
    alone = dict.fromkeys(("beacon", "answer", "acquisition"))
    half = link.of(read(alone, lit, {"terminals.leo_aperture": "1 cm"}).mission).beam.fall.half_angle_rad
    for share, wide in ((0.99, True), (1.01, False)):
        aperture = {"terminals.leo_aperture": f"{share * half / 0.1 * 1e4:.6f} um"}
        found = warned(budget_of(read(alone, lit, aperture)), "LEO aperture gain: the half angle of")
        assert bool(found) == wide


# ---- solved for
KINDS = [None, *RECEIVERS]


def kind(name):
    return {} if name is None else received_with(name)


@pytest.mark.parametrize("name", KINDS)
def test_the_largest_rate_leaves_the_margin_or_is_the_receivers_highest(read, name):
    for changes in ({}, {**PATTERN, **CHANNEL}):
        file = read(kind(name), changes)
        for margin, error in ((3.0, 10e-6), (6.0, 0.0), (20.0, 15e-6)):
            rate = link.largest_data_rate(link.of(file.mission), margin, error)
            left = budget_of(file, error, rate).margin_db
            built = link.of(file.mission).receiver
            if built is not None and rate == built.highest_data_rate_bit_s:
                assert left >= margin
            else:
                assert left == pytest.approx(margin, abs=1e-6)


@pytest.mark.parametrize("name", KINDS)
def test_the_largest_error_leaves_the_margin(read, name):
    for changes in ({}, PATTERN, {**UNCORRECTED, "point_ahead.transverse_velocity": "1 km/s", **PATTERN}):
        file = read(kind(name), changes, {"communication.distance": "20000 km"})
        on_axis = float(link.margin_map(link.of(file.mission), 1e8, 0.0)[0, 0])
        for margin in (on_axis - 0.01, on_axis - 3.0, on_axis - 15.0):
            error = link.largest_pointing_error(link.of(file.mission), margin, 1e8)
            assert budget_of(file, error, 1e8).margin_db == pytest.approx(margin, abs=1e-5)
            assert 0.0 < error < 60e-6
        assert link.largest_pointing_error(link.of(file.mission), on_axis, 1e8) == pytest.approx(0.0, abs=1e-12)


def test_a_margin_far_above_the_need_ends_before_the_first_null(read):
    file = read({**PATTERN, "communication.beam": {"profile": "uniform"}}, {"communication.transmit_power": "500 kW"})
    excess = float(link.margin_map(link.of(file.mission), 1e6, 0.0)[0, 0])
    assert excess > 60.0
    error = link.largest_pointing_error(link.of(file.mission), 0.0, 1e6)
    assert error == pytest.approx(1.21967 * WAVELENGTH / 0.05, rel=0.01)


def test_a_point_ahead_beyond_the_main_lobe_is_refused(read):
    file = read(PATTERN, UNCORRECTED, {"communication.transmit_power": "500 kW"})
    with pytest.raises(link.LinkError, match="lies beyond the main lobe of the beam, which has fallen as far at"):
        link.largest_pointing_error(link.of(file.mission), 0.0, 1e3)


@pytest.mark.parametrize("name", ["counting ook", "pin ook", "apd ook", "preamplified ook", "counting ppm"])
def test_noise_that_does_not_fall_with_the_rate_leaves_no_rate_at_all(read, name):
    file = read(received_with(name), {"communication.transmit_power": "1 pW"})
    with pytest.raises(link.LinkError, match=r"not even 1 bit/s leaves a margin of 3 dB: [0-9.]+ dB are missing"):
        link.largest_data_rate(link.of(file.mission), 3.0, 10e-6)


def test_a_receiver_slower_than_one_bit_in_a_second_has_its_own_highest(read):
    file = read(received_with("pin ook", bandwidth="0.5 Hz"))
    assert link.largest_data_rate(link.of(file.mission), 3.0, 10e-6) == pytest.approx(0.4)
    weak = read(received_with("pin ook", bandwidth="0.5 Hz"), {"communication.transmit_power": "1 pW"})
    with pytest.raises(link.LinkError, match=r"not even 0\.4 bit/s leaves"):
        link.largest_data_rate(link.of(weak.mission), 3.0, 10e-6)


@pytest.mark.parametrize("name", [None, "apd ook"])
def test_a_rate_of_largest_is_solved_for_at_the_required_margin_and_error(read, name):
    file = read(kind(name), {"communication.data_rate": "largest"})
    assert read(kind(name)).mission.communication.data_rate_bit_s == RATE
    with pytest.raises(ValueError, match='"largest" has to be solved for first'):
        budget_of(file)
    known = link_study.solve_rate(file)
    assert budget_of(known, file.mission.requirement.pointing_error_rad).margin_db == pytest.approx(3.0, abs=1e-6)
    assert known.sources["communication.data_rate"].comment.startswith("solved for: the largest with 3 dB at 10 ")
    assert link_study.solve_rate(known) is known


def test_a_rate_of_largest_without_any_is_refused(read):
    file = read(
        received_with("pin ook"), {"communication.data_rate": "largest", "communication.transmit_power": "1 pW"}
    )
    with pytest.raises(link.LinkError, match="not even 1 bit/s"):
        link_study.solve_rate(file)


@pytest.mark.parametrize(
    ("rate", "error", "what"),
    [
        (math.inf, 0.0, r"the data rate is inf bit/s: it must be finite, above 0 bit/s"),
        (1e8, math.inf, r"the pointing error is inf rad: it must be finite, at least 0 rad"),
    ],
)
def test_points_without_end_are_refused(read, rate, error, what):
    for change in ({}, PATTERN):
        with pytest.raises(ValueError, match=what):
            link.margin_map(link.of(read(change).mission), [rate], [error])


# ---- readings
def test_each_reading_has_its_map(read):
    file = read()
    maps = link.convention_maps(link.of(file.mission), [1e8, 3e8], [0.0, 10e-6, 20e-6])
    assert set(maps) == {(loss, strehl) for loss in ("gaussian", "gain") for strehl in ("decibel", "ratio")}
    for (loss, strehl), margins in maps.items():
        conventions = {"conventions.pointing_loss": loss, "conventions.strehl": strehl}
        own = link.margin_map(link.of(read(conventions).mission), [1e8, 3e8], [0.0, 10e-6, 20e-6])
        np.testing.assert_allclose(margins, own, rtol=0, atol=1e-9)


def test_a_wavefront_error_has_one_reading_and_a_pattern_is_read_as_even_light(read):
    quality = {"communication.strehl": None, "communication.wavefront_error": "100 nm"}
    maps = link.convention_maps(link.of(read(PATTERN, quality).mission), RATE, 10e-6)
    assert set(maps) == {("gaussian", "wavefront error"), ("gain", "wavefront error")}
    expected = link.margin_map(link.of(read(quality).mission), RATE, 10e-6)
    np.testing.assert_allclose(maps["gaussian", "wavefront error"], expected, rtol=0, atol=1e-9)


def test_a_pattern_needs_to_know_how_its_aperture_is_lit(read):
    assert link.of(read(PATTERN).mission).beam.fall == beams.LitAperture(0.05, WAVELENGTH, 1.25, 0.0, 1.2)
    with pytest.raises(ValueError, match=r"needs the table \[communication.beam\]: how the aperture is lit"):
        link.of(read().mission.with_value("conventions.pointing_loss", "pattern"))
    assert GAUSSIAN["radius"] == "2 cm"


# ---- what is stated as nothing, and limits that are met exactly
def test_a_budget_closes_at_no_margin_and_where_as_much_arrives_as_was_sent(read):
    plain = budget_of(read())
    sent_w = 1e-3 * 10.0 ** (plain.lines[0].value / 10.0)
    for margin_db, closes in ((0.0, True), (-0.5e-9, True), (-1e-8, False)):
        assert dataclasses.replace(plain, margin_db=margin_db).closes == closes
    for share, possible in ((1.0 - 1e-12, True), (1.0 + 1e-9, False)):
        found = dataclasses.replace(plain, margin_db=1.0, received_power_w=share * sent_w)
        assert (found.possible, found.closes) == (possible, possible)


@pytest.mark.parametrize(
    ("name", "key", "none", "line"),
    [
        ("heterodyne bpsk", "phase_error", "0 rad", "Phase error penalty"),
        ("homodyne bpsk", "inter_symbol_loss", "0 dB", "Inter-symbol loss"),
    ],
)
def test_what_is_stated_as_nothing_is_told_from_what_is_not_given(read, name, key, none, line):
    for value, basis in ((none, "as given"), (None, "taken as none")):
        budget = budget_of(read(received_with(name, **{key: value})))
        found = line_of(budget, line)
        assert (found.value, found.basis, found.warning) == (0.0, basis, LEFT_AT_ZERO)
        assert (found.source == "not given") == (value is None)
        assert line in budget.at_zero


def test_a_loss_between_symbols_that_is_stated_is_taken_off(read):
    plain, lossy = (
        budget_of(read(received_with("homodyne bpsk", inter_symbol_loss=loss))) for loss in (None, "0.5 dB")
    )
    found = line_of(lossy, "Inter-symbol loss")
    assert (found.value, found.basis, found.warning) == (-0.5, "as given", "")
    assert lossy.margin_db == pytest.approx(plain.margin_db - 0.5, abs=1e-9)


@pytest.mark.parametrize(
    "path",
    [
        None,
        SimpleNamespace(satellite_radius_m=None, elevation_rad=0.5),
        SimpleNamespace(satellite_radius_m=7e6, elevation_rad=math.pi / 2.0),
    ],
    ids=["vacuum", "of a stated elevation", "to the zenith"],
)
def test_without_an_elevation_that_goes_with_the_range_farther_is_by_its_square(path):
    data = SimpleNamespace(range_m=1e6, shared=SimpleNamespace(path=path))
    np.testing.assert_allclose(link.farther_db(data, [5e5, 1e6, 1e7]), [-20.0 * math.log10(2.0), 0.0, 20.0], atol=1e-12)


def test_the_air_of_its_parts_is_scattering_haze_and_absorption_each_of_which_may_be_none(read):
    """Haze of a depth d at 1 um is d (wavelength / 1 um)^-a; nothing of it without a depth."""

    def loss(**given):
        m = read({"channel": {"elevation": "90 deg", "height": "0 m", **given}}).mission
        return link.of(m).air_db

    clean = loss(aerosol_depth=0.0, angstrom_exponent=1.3, absorption="0 dB")
    flat = loss(aerosol_depth=0.1, angstrom_exponent=0.0, absorption="0 dB")
    steep = loss(aerosol_depth=0.1, angstrom_exponent=1.3, absorption="0 dB")
    wet = loss(aerosol_depth=0.0, angstrom_exponent=1.3, absorption="0.4 dB")
    mass = gains.air_mass(math.pi / 2.0)
    assert clean == pytest.approx(gains.rayleigh_depth(WAVELENGTH, 0.0) * 10.0 / math.log(10.0) * mass, rel=1e-6)
    assert flat - clean == pytest.approx(0.1 * 10.0 / math.log(10.0) * mass, rel=1e-9)
    assert steep - clean == pytest.approx((flat - clean) * (WAVELENGTH / 1e-6) ** -1.3, rel=1e-9)
    assert wet - clean == pytest.approx(0.4 * mass, rel=1e-9)


FEW_MODES = Coupling.model_construct(core_radius_m=12.5e-6, numerical_aperture=0.22)


@pytest.mark.parametrize(("found", "expected"), [
    (lambda: lines._cut_by_aperture(31e-6, 0.021, 1.55e-6),
     "a Gaussian beam this narrow is 31.83 mm wide at 1/e2, and the aperture of 21 mm cuts it: 9.05 dB less gain "
     "than this, and a wider core"),
    (lambda: lines._cut_by_aperture(31e-6, 0.057, 1.55e-6),
     "a Gaussian beam this narrow is 31.83 mm wide at 1/e2, and the aperture of 57 mm cuts it: 0.36 dB less gain "
     "than this, and a wider core"),
    (lambda: lines._blocked(0.0), ""),
    (lambda: lines._blocked(0.125),
     "the obscuration of 0.125 is not in it: what it stops of the beam belongs into transmit_optics_loss"),
    (lambda: lines._wide("the error", 0.1), ""),
    (lambda: lines._wide("the error", 0.12345), "the error of 123 mrad is above 0.1 rad, where small angles end"),
    (lambda: lines._deep(-20.0), ""),
    (lambda: lines._deep(20.25), "beyond 20 dB the wings and the scatter of a real beam decide, not this formula"),
    (lambda: lines._both("", "a", "", "b"), "a; b"),
    (lambda: lines._few_modes(FEW_MODES, 1.55e-6),
     "the fibre has V = 11.1, too few modes (below 20) to take all light on its core"),
    (lambda: lines._few_modes(FEW_MODES, 3.1e-7), ""),
    (lambda: lines._few_modes(FEW_MODES.model_copy(update={"core_radius_m": None}), 1.55e-6), ""),
    (lambda: str(lines.given_or_own(1.5, None, "own", "given")), "(1.5, 'own')"),
    (lambda: str(lines.given_or_own(1.5, 0, "own", "given")), "(0.0, 'given')"),
])  # fmt: skip
def test_what_is_doubted_of_a_beam_is_said_with_its_numbers(found, expected):
    assert found() == expected


@pytest.mark.parametrize(("changes", "expected"), [
    (
        {"conventions.pointing_loss": "gain", "point_ahead": None, "communication.strehl": None,
         "communication.wavefront_error": "350 nm"},
        {
            "Strehl loss": "-8.742: exp(-(2 pi s / lambda)^2), s = 350 nm rms | mission file | on axis, small "
            "wavefront error (Marechal) | beyond 5 dB a beam has no core to speak of",
            "Pointing loss": "-4.460: exp(-G error^2), G = (pi D / lambda)^2, error = 10 µrad | mission file | beam "
            "that falls off as a Gaussian set by its own gain; static error | ",
            "Point-ahead loss": "0.000: taken as corrected | not given | added to the pointing error in its worst "
            "direction | left at 0 dB",
        },
    ),
    (
        {"conventions.pointing_loss": "pattern", "communication.beam": {"profile": "uniform"},
         "terminals.leo_obscuration": 0.25},
        {
            "Illumination": "-0.280: 1 - e^2, lit evenly over the open area, e = 0.25 | mission file | power counted "
            "behind the aperture | ",
            "Strehl loss": "-0.400: as given in dB | mission file | on axis, small wavefront error (Marechal) | ",
            "Point-ahead loss": "0.000: corrected; what that leaves is for the pointing error to hold | mission file | "
            "added to the pointing error in its worst direction | ",
        },
    ),
])  # fmt: skip
def test_lines_of_other_conventions_say_what_they_are_and_where_they_hold(read, changes, expected):
    """Each line as value, basis, source without its place, regime and warning."""
    found = {line.name: line for line in budget_of(read(changes)).lines}
    for name, said in expected.items():
        line = found[name]
        source = line.source.partition(",")[0]
        assert f"{line.value:.3f}: {line.basis} | {source} | {line.regime} | {line.warning}" == said


def test_the_rate_at_a_loss_is_told_down_to_the_slowest_and_no_further(read):
    """With a measured sensitivity the rate falls in proportion to the power."""
    data = link.of(read({}).mission)
    slowest = maps.SLOWEST_BIT_S
    spare = maps.received_on_axis_dbm(data) - float(link.required_dbm(data, slowest))
    for left in (0.0, 0.4, 3.0):
        rate = link.rate_at_loss(data, 2.0, spare - 2.0 - left - 1e-9 * (left == 0.0))
        assert rate == pytest.approx(slowest * 10.0 ** (0.1 * left), rel=1e-6)
    with pytest.raises(link.LinkError) as refused:
        link.rate_at_loss(data, 2.0, spare - 2.0 + 0.25)
    assert str(refused.value).endswith("leaves a margin of 2 dB: 0.25 dB are missing")


@pytest.mark.parametrize("name", ["beacon", "answer"])
def test_an_uncorrected_point_ahead_is_a_line_of_a_gaussian_beam_beyond_its_own_error(read, name):
    """exp(-2 (error / theta)^2) with the error, and with both angles in one line."""
    beam = {f"{name}.divergence": "60 urad", f"{name}.pointing_error": "11 urad"}
    ahead = {"point_ahead.corrected": False, "point_ahead.transverse_velocity": "3000 m/s"}
    angle, per_square = 2.0 * 3000.0 / SPEED_OF_LIGHT_M_S, 20.0 / math.log(10.0)
    file = read(beam, ahead)
    half = half_angle_rad(60e-6, file.mission.conventions.divergence)
    budget = link.beam_budget(name, link.Shared.of(file.mission), getattr(file.mission, name), file.sources)
    found = {line.name: line for line in budget.lines}
    own, both = (per_square * (error / half) ** 2 for error in (11e-6, 11e-6 + angle))
    assert found["Pointing loss"].value == pytest.approx(-own, rel=1e-12)
    line = found["Point-ahead loss"]
    assert line.value == pytest.approx(own - both, rel=1e-12)
    assert (line.basis, line.regime) == (
        "not corrected: 2 v / c = 20.01 µrad",
        "added to the pointing error in its worst direction",
    )
    source = [part.partition(",")[0] for part in line.source.split("; ")]
    assert (source, line.warning) == (["mission file"] * 2, "")
