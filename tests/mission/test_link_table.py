"""What a file about links may hold: each refusal with its limit, all of them at once, and what is taken."""

import math
import re
from types import SimpleNamespace

import pytest

from link_files import GAUSSIAN, OPTIONAL, PATTERN, RECEIVERS, SKY, data_with, link_file, received_with, written
from made_tables import made, one_line, told
from microrad.core.units import parse_quantity
from microrad.link.beams import LitAperture
from microrad.link.gains import gaussian_beam_gain_db
from microrad.mission.file import MissionError, load_link
from microrad.mission.model import (
    LinkMission,
    Mission,
    _cone_fits,
    _coupling_fits,
    _loop_there,
    _outage_given,
    _point_ahead_fits,
    mission_schema,
)
from microrad.mission.tables.coupling import Coupling
from microrad.mission.tables.link import (
    Beam,
    BeamShape,
    Communication,
    Fading,
    Receiver,
    divergence_fits,
    half_angle_rad,
    narrowest_half_angle_rad,
    obscuration_fits,
    pattern_fits,
    strehl_fits,
)
from microrad.mission.tables.pointing import JitterTable, Pointing
from shipped import SHIPPED, without_fine_pointing


def faults(folder, *changes):
    """The faults of the paper's links with changes, by key."""
    merged = {}
    for each in changes:
        merged |= each
    return faults_of(written(folder, data_with(merged)))


def faults_of(path):
    with pytest.raises(MissionError) as refused:
        load_link(path)
    found = {}
    for fault in refused.value.faults:
        assert fault.reason in str(refused.value)
        assert fault.expected
        found.setdefault(fault.key, []).append(f"{fault.reason}: {fault.expected}")
    return {key: " | ".join(texts) for key, texts in found.items()}


def the_fault(folder, *changes):
    found = faults(folder, *changes)
    assert len(found) == 1, found
    return next(iter(found.items()))


def test_a_fault_of_one_table_hides_none_of_what_lies_between_others(tmp_path):
    holed = {**PATTERN, "terminals.leo_obscuration": 0.6, "communication.beam": {**GAUSSIAN, "radius": "2 mm"}}
    found = faults(tmp_path, holed, received_with("preamplified dpsk", bandwidth="5 m"))
    assert set(found) == {"communication.receiver.bandwidth", "communication.beam.radius"}
    found = faults(tmp_path, holed, received_with("preamplified dpsk", detector="homodyne"))
    assert set(found) == {"communication.receiver.detector", "communication.beam.radius"}
    both = {"communication.receiver_sensitivity": "100 photon/bit", "communication.strehl": None}
    found = faults(tmp_path, received_with("pin ook", bandwidth="5 m", dark_current=None), both)
    assert set(found) == {
        "communication.receiver.bandwidth",
        "communication.receiver.dark_current",
        "communication.receiver_sensitivity",
        "communication.strehl",
    }


def test_a_misspelled_key_is_not_missed_as_well(tmp_path):
    table = received_with("preamplified dpsk", noise_figure=None, noise_figur="4 dB")
    assert the_fault(tmp_path, table)[0] == "communication.receiver.noise_figur"


SLOW = "a number without quotes, at least 1e-18 and below 0.5"


# ---- one value out of its bounds
@pytest.mark.parametrize(
    ("key", "value", "said"),
    [
        ("communication.strehl", -0.1, "is below 0"),
        ("communication.transmit_optics_loss", "-1 dB", "is below 0 dB"),
        ("communication.receive_optics_loss", "-0.1 dB", "is below 0 dB"),
        ("communication.tracking_split_loss", "-1 dB", "is below 0 dB"),
        ("communication.implementation_loss", "-1 dB", "is below 0 dB"),
        ("beacon.transmit_optics_loss", "-1 dB", "is below 0 dB"),
        ("answer.receive_optics_loss", "-1 dB", "is below 0 dB"),
        ("requirement.margin", "-1 dB", "is below 0 dB"),
        ("requirement.outage", 0.0, "is not above 0 and below 1"),
        ("requirement.outage", 1.0, "is not above 0 and below 1"),
        ("terminals.leo_obscuration", 1.0, "is above 0.95: a number without quotes, at least 0, at most 0.95"),
        ("terminals.geo_obscuration", 1, "is above 0.95"),
        ("terminals.geo_obscuration", -0.1, "is below 0"),
        ("terminals.leo_aperture", "0 cm", "is not above 0 m"),
        ("terminals.leo_aperture", "5 km", "is above 100 m"),
        ("communication.wavelength", "1.55 m", "is above 10 mm"),
        ("communication.data_rate", "0 bit/s", "is not above 0 bit/s"),
        ("communication.data_rate", "fastest", 'or "largest" for what the required margin leaves'),
        ("communication.receiver_sensitivity", "0 photon/bit", "is not above 0 photon/bit"),
        ("communication.pointing_error", "-1 urad", "is below 0 rad"),
        ("communication.transmit_power", "0 W", "is not above 0 W"),
        ("beacon.required_power", "0 pW", "is not above 0 W"),
        ("point_ahead.corrected", "yes", "is neither true nor false"),
        ("conventions.pointing_loss", "top-hat", 'pointing_loss = "pattern"'),
    ],
)
def test_a_value_out_of_bounds_is_refused_with_the_bound(tmp_path, key, value, said):
    found, text = the_fault(tmp_path, {key: value})
    assert found == key
    assert said in text


@pytest.mark.parametrize(
    ("key", "value", "said"),
    [
        ("bit_error_ratio", 0.5, f"is not above 0 and below 0.5: {SLOW}"),
        ("bit_error_ratio", 0.0, f"is below 1e-18: {SLOW}"),
        ("bit_error_ratio", 1e-19, f"is below 1e-18: {SLOW}"),
        ("code_rate", 1.01, "is above 1"),
        ("code_rate", 0.0, "is not above 0"),
        ("code_gain", "-1 dB", "is below 0 dB"),
        ("bandwidth", "0 Hz", "is not above 0 Hz"),
        ("efficiency", 1.1, "is above 1"),
        ("efficiency", 0.0, "is not above 0"),
        ("dark_count_rate", "-1 1/s", "is below 0 1/s"),
        ("background_power", "-1 pW", "is below 0 W"),
        ("order", 12, "is no power of two: order = 16 would do"),
        ("order", 1, "is below 2: a whole number without quotes, from 2 to 1048576"),
        ("order", 16.0, "is not a whole number: a whole number without quotes"),
        ("order", "16", "is not a whole number: a whole number without quotes"),
    ],
)
def test_a_receivers_value_out_of_bounds_is_refused_with_the_bound(tmp_path, key, value, said):
    found, text = the_fault(tmp_path, received_with("counting ppm", **{key: value}))
    assert found == f"communication.receiver.{key}"
    assert said in text


@pytest.mark.parametrize(
    ("name", "key", "value", "said"),
    [
        ("preamplified dpsk", "noise_figure", "2.9 dB", "is below 3 dB"),
        ("preamplified ook", "amplifier_gain", "9 dB", "is below 10 dB"),
        ("preamplified ook", "optical_bandwidth", "0 GHz", "is not above 0 Hz"),
        ("counting ook", "extinction_ratio", "0 dB", "is not above 0 dB"),
        ("counting ook", "extinction_ratio", "1e-15 dB", "is below 0.001 dB, where marks and spaces are alike"),
        ("apd ook", "avalanche_gain", 0.9, "is below 1"),
        ("apd ook", "ionisation_ratio", 1.1, "is above 1"),
        ("apd ook", "dark_current", "-1 nA", "is below 0 A"),
        ("pin ook", "thermal_noise", "-1 pA/sqrt(Hz)", "is below 0 A/sqrt(Hz)"),
    ],
)
def test_what_only_some_receivers_have_is_bounded_too(tmp_path, name, key, value, said):
    found, text = the_fault(tmp_path, received_with(name, **{key: value}))
    assert found == f"communication.receiver.{key}"
    assert said in text


@pytest.mark.parametrize(
    ("key", "value", "said"),
    [
        ("spectral_radiance", "-1 W/(m^2 sr um)", "is below 0"),
        ("field_of_view", "0 urad", "is not above 0 rad"),
        ("filter_bandwidth", "0 nm", "is not above 0 m"),
        ("filter_bandwidth", "1 mm", "is above 10 µm"),
    ],
)
def test_a_background_is_bounded(tmp_path, key, value, said):
    receiver = received_with("pin ook", background_power=None, background={**SKY, key: value})
    found, text = the_fault(tmp_path, receiver)
    assert found == f"communication.receiver.background.{key}"
    assert said in text


@pytest.mark.promise("link-20")
@pytest.mark.parametrize(
    ("key", "value", "said"),
    [
        ("zenith_transmission", 0.0, "is not above 0"),
        ("zenith_transmission", 1.1, "is above 1"),
        ("elevation", "9.9 deg", "is below 10 deg"),
        ("elevation", "91 deg", "is above 90 deg"),
    ],
)
def test_a_channel_is_a_clear_sky_from_ten_degrees_up(tmp_path, key, value, said):
    found, text = the_fault(tmp_path, {"channel": {"zenith_transmission": 0.8, "elevation": "30 deg", key: value}})
    assert found == f"channel.{key}"
    assert said in text


def test_ten_degrees_and_the_zenith_are_taken(tmp_path):
    for degrees in (10, 90):
        channel = {"channel": {"zenith_transmission": 1.0, "elevation": f"{degrees} deg"}}
        assert link_file(tmp_path, channel).mission.channel.elevation_rad == pytest.approx(math.radians(degrees))


# ---- what belongs together
@pytest.mark.promise("link-4")
@pytest.mark.parametrize("link", ["communication", "beacon", "answer"])
def test_the_quality_of_a_beam_is_said_once(tmp_path, link):
    found, text = the_fault(tmp_path, {f"{link}.strehl": None})
    assert (found, text) == (f"{link}.strehl", "is missing, and so is wavefront_error: strehl = 0.4 would do")
    found, text = the_fault(tmp_path, {f"{link}.wavefront_error": "50 nm"})
    assert (found, text) == (f"{link}.strehl", "stands beside wavefront_error: one of the two removed")
    read = link_file(tmp_path, {f"{link}.strehl": None, f"{link}.wavefront_error": "50 nm"}).mission
    assert getattr(read, link).wavefront_error_m == pytest.approx(50e-9)


@pytest.mark.parametrize("link", ["communication", "beacon", "answer"])
def test_a_wavefront_error_is_at_most_a_quarter_of_a_wave(tmp_path, link):
    change = {f"{link}.strehl": None, f"{link}.wavefront_error": "388 nm"}
    found, text = the_fault(tmp_path, change)
    assert found == f"{link}.wavefront_error"
    assert "is above a quarter of the wavelength (387.5 nm): such a beam has no core to point" in text
    assert link_file(tmp_path, {**change, f"{link}.wavefront_error": "387.5 nm"})


@pytest.mark.parametrize("link", ["communication", "beacon", "answer"])
@pytest.mark.parametrize("strehl", [1.01, 0.0])
def test_a_strehl_ratio_is_above_zero_and_at_most_one(tmp_path, link, strehl):
    found, text = the_fault(tmp_path, {"conventions.strehl": "ratio", f"{link}.strehl": strehl})
    assert found == f"{link}.strehl"
    assert f'is no ratio, but conventions.strehl = "ratio" ({strehl:g}): above 0 and at most 1' in text
    assert link_file(tmp_path, {"conventions.strehl": "ratio", f"{link}.strehl": 1.0})
    assert link_file(tmp_path, {"conventions.strehl": "decibel", f"{link}.strehl": strehl})


@pytest.mark.promise("link-15")
@pytest.mark.parametrize(("link", "aperture", "diameter"), [("beacon", "leo", 0.05), ("answer", "geo", 0.15)])
@pytest.mark.parametrize(("convention", "factor"), [("full-1/e2", 2.0), ("half-1/e2", 1.0)])
def test_no_beam_is_narrower_than_diffraction_leaves_it(tmp_path, link, aperture, diameter, convention, factor):
    least = factor * math.sqrt(8) * 1.55e-6 / (math.pi * diameter)
    conventions = {"conventions.divergence": convention}
    found, text = the_fault(tmp_path, conventions, {f"{link}.divergence": f"{least * 0.999e6:.6f} urad"})
    assert found == f"{link}.divergence"
    assert f"is below diffraction at {aperture}_aperture = {diameter * 100:g} cm" in text.replace(
        "50 mm", "5 cm"
    ).replace("150 mm", "15 cm")
    assert f"({convention.partition('-')[0]} angle at 1/e2)" in text
    named = text.rpartition('at least "')[2].partition('"')[0]
    assert parse_quantity(named, "rad") == pytest.approx(least, rel=2e-3)
    for enough in (f"{least * 1.000001e6:.6f} urad", named):
        assert link_file(tmp_path, conventions, {f"{link}.divergence": enough})


@pytest.mark.promise("link-15")
@pytest.mark.promise("link-59")
def test_widths_of_an_aperture_lit_evenly_are_no_divergences_of_a_gaussian_beam():
    """9.4 urad at 847 nm from 95 mm: the width at half maximum, and no full angle at 1/e2 by any reading."""
    diameter, wavelength = 95e-3, 847e-9
    even, least = LitAperture(diameter, wavelength, 0.0, 0.0), narrowest_half_angle_rad(diameter, wavelength)
    at_e2, at_half = (even.error_rad(loss) for loss in (20 / math.log(10), 10 * math.log10(2)))
    assert at_e2 * diameter / wavelength == pytest.approx(0.8225, abs=1e-4)
    assert 2 * at_half * diameter / wavelength == pytest.approx(1.029, abs=1e-3)
    assert 2 * at_half < 9.4e-6 < 2 * at_e2
    assert gaussian_beam_gain_db(least) == pytest.approx(even.gain_db, abs=1e-9)
    assert gaussian_beam_gain_db(at_e2) - even.gain_db == pytest.approx(0.79, abs=0.01)
    assert gaussian_beam_gain_db(2 * wavelength / (math.pi * diameter)) - even.gain_db == pytest.approx(3.01, abs=0.01)
    assert gaussian_beam_gain_db(9.4e-6 / 2) - even.gain_db == pytest.approx(4.65, abs=0.01)


@pytest.mark.promise("link-15")
def test_a_width_that_is_a_half_angle_and_no_full_one(tmp_path):
    """9.4 urad at 847 nm from 95 mm, as docs/link.md has it."""
    terminal = {"terminals.geo_aperture": "95 mm", "answer.wavelength": "847 nm", "answer.divergence": "9.4 urad"}
    found, text = the_fault(tmp_path, terminal, {"conventions.divergence": "full-1/e2"})
    assert found == "answer.divergence"
    assert "is below diffraction at geo_aperture = 95 mm, which leaves no less than 16.07 µrad (full angle" in text
    assert (
        link_file(tmp_path, terminal, {"conventions.divergence": "half-1/e2"}).mission.answer.divergence_rad == 9.4e-6
    )


@pytest.mark.promise("link-15")
def test_the_narrowest_gaussian_beam_has_the_gain_of_the_whole_aperture():
    half = narrowest_half_angle_rad(0.05, 1.55e-6)
    assert 8 / half**2 == pytest.approx((math.pi * 0.05 / 1.55e-6) ** 2, rel=1e-12)
    assert half_angle_rad(780e-6, "full-1/e2") == 390e-6
    assert half_angle_rad(780e-6, "half-1/e2") == 780e-6


@pytest.mark.promise("link-4")
def test_a_pattern_needs_a_beam_and_a_beam_a_pattern(tmp_path):
    found, text = the_fault(tmp_path, {"conventions.pointing_loss": "pattern"})
    assert found == "conventions.pointing_loss"
    assert "needs the table communication.beam, which is missing" in text
    for convention in ("gaussian", "gain"):
        beam = {"communication.beam": GAUSSIAN, "conventions.pointing_loss": convention}
        found, text = the_fault(tmp_path, beam)
        assert found == "conventions.pointing_loss"
        assert f'does not take communication.beam into account ("{convention}"): pointing_loss = "pattern"' in text
    assert link_file(tmp_path, PATTERN).mission.communication.beam.radius_m == pytest.approx(0.02)


@pytest.mark.promise("link-4")
@pytest.mark.parametrize(
    ("beam", "expected"),
    [
        ({"radius": None}, {"radius": 'is missing, and profile = "gaussian" needs it: radius = "2 cm" would do'}),
        ({"m_squared": None}, {"m_squared": 'is missing, and profile = "gaussian" needs it: m_squared = 1.1 would do'}),
        ({"m_squared": 0.9}, {"m_squared": "is below 1: a number without quotes, at least 1, at most 1000"}),
        ({"radius": "0 cm"}, {"radius": "is not above 0 m"}),
        (
            {"profile": "uniform"},
            {"radius": 'does not belong to profile = "uniform"', "m_squared": 'does not belong to profile = "uniform"'},
        ),
        ({"profile": "flat"}, {"profile": 'is none of the choices: profile = "uniform" or profile = "gaussian"'}),
    ],
)
def test_a_beam_has_what_its_profile_needs(tmp_path, beam, expected):
    table = {key: value for key, value in {**GAUSSIAN, **beam}.items() if value is not None}
    found = faults(tmp_path, PATTERN, {"communication.beam": table})
    assert set(found) == {f"communication.beam.{key}" for key in expected}
    assert all(said in found[f"communication.beam.{key}"] for key, said in expected.items())


def test_a_beam_that_its_obscuration_stops_is_refused(tmp_path):
    holed = {**PATTERN, "terminals.leo_obscuration": 0.6}
    narrow = {"communication.beam": {**GAUSSIAN, "radius": "9 mm"}}
    found, text = the_fault(tmp_path, holed, narrow)
    assert found == "communication.beam.radius"
    assert 'leaves less than 1 % of the beam beside leo_obscuration = 0.6: at least "9.895 mm"' in text
    assert link_file(tmp_path, holed, {"communication.beam": {**GAUSSIAN, "radius": "9.895 mm"}})


@pytest.mark.promise("choose-10")
@pytest.mark.promise("link-4")
def test_one_receiver_is_said(tmp_path):
    found, text = the_fault(tmp_path, {"communication.receiver_sensitivity": None})
    assert found == "communication.receiver_sensitivity"
    assert "is missing, and so is the table receiver" in text
    assert 'receiver_sensitivity = "100 photon/bit" would do, or a table receiver' in text
    found, text = the_fault(tmp_path, {"communication.receiver": RECEIVERS["pin ook"]})
    assert (found, text) == (
        "communication.receiver_sensitivity",
        "stands beside the table receiver: one of the two removed",
    )


FITTING = {
    "ook": {"photon-counting", "pin", "apd", "preamplified"},
    "dpsk": {"preamplified"},
    "bpsk": {"homodyne", "heterodyne"},
    "qpsk": {"homodyne", "heterodyne"},
    "ppm": {"photon-counting"},
}


@pytest.mark.promise("choose-11")
@pytest.mark.promise("link-23")
@pytest.mark.parametrize("modulation", FITTING)
@pytest.mark.parametrize("name", RECEIVERS)
def test_a_detector_that_does_not_receive_the_modulation_is_refused_with_those_that_do(tmp_path, name, modulation):
    detector = RECEIVERS[name]["detector"]
    if detector in FITTING[modulation]:
        return
    found, text = the_fault(tmp_path, received_with(name, modulation=modulation))
    assert found == "communication.receiver.detector"
    assert text.startswith(f'does not receive modulation = "{modulation}": ')
    assert {each for each in FITTING["ook"] | FITTING["bpsk"] if f'detector = "{each}"' in text} == FITTING[modulation]


@pytest.mark.promise("link-22")
@pytest.mark.parametrize("name", RECEIVERS)
def test_each_key_that_a_receiver_needs_is_missed(tmp_path, name):
    assert link_file(tmp_path, received_with(name)).mission.communication.receiver is not None
    for key in RECEIVERS[name].keys() - OPTIONAL:
        found, text = the_fault(tmp_path, received_with(name, **{key: None}))
        assert found == f"communication.receiver.{key}"
        assert text.startswith("is missing")


@pytest.mark.promise("link-22")
@pytest.mark.parametrize("name", RECEIVERS)
def test_each_key_that_a_receiver_has_no_use_for_is_refused(tmp_path, name):
    every = {key: value for table in RECEIVERS.values() for key, value in table.items()}
    own = RECEIVERS[name].keys() | (OPTIONAL if RECEIVERS[name]["modulation"] in ("bpsk", "qpsk") else set())
    surplus = {key: value for key, value in every.items() if key not in own}
    found = faults(tmp_path, received_with(name, **surplus))  # all of them at once
    assert set(found) == {f"communication.receiver.{key}" for key in surplus}
    table = RECEIVERS[name]
    what = f'does not belong to modulation = "{table["modulation"]}", detector = "{table["detector"]}"'
    assert all(what in text for text in found.values())


@pytest.mark.parametrize("name", RECEIVERS)
def test_a_sky_stands_in_place_of_a_background_power(tmp_path, name):
    sky = received_with(
        name, background=SKY, **({"background_power": None} if "background_power" in RECEIVERS[name] else {})
    )
    assert link_file(tmp_path, sky).mission.communication.receiver.background.filter_bandwidth_m == pytest.approx(1e-9)
    found, text = the_fault(tmp_path, received_with(name, background=SKY, background_power="1 pW"))
    assert found == "communication.receiver.background_power"
    assert text == "stands beside the table background: one of the two removed"


def test_every_problem_of_a_receiver_is_told_at_once(tmp_path):
    found = faults(tmp_path, received_with("counting ppm", order=12, efficiency=None, noise_figure="4 dB"))
    assert set(found) == {f"communication.receiver.{key}" for key in ("order", "efficiency", "noise_figure")}


@pytest.mark.promise("link-3")
def test_every_fault_of_a_file_is_told_at_once(tmp_path):
    found = faults(
        tmp_path,
        {
            "terminals.geo_obscuration": 1.0,
            "conventions.strehl": "ratio",
            "conventions.pointing_loss": "pattern",
            "beacon.strehl": 1.2,
            "beacon.transmit_power": "0 W",
            "answer.strehl": 1.3,
            "communication.strehl": 1.4,
            "requirement.outage": 1.0,
            "requirement.margn": "3 dB",
            "channel": {"zenith_transmission": 2.0, "elevation": "5 deg"},
            "point_ahead.corrected": 1,
        },
    )
    assert set(found) == {
        "terminals.geo_obscuration",
        "conventions.pointing_loss",
        "beacon.strehl",
        "beacon.transmit_power",
        "answer.strehl",
        "communication.strehl",
        "requirement.outage",
        "requirement.margn",
        "channel.zenith_transmission",
        "channel.elevation",
        "point_ahead.corrected",
    }


def test_what_does_not_fit_between_tables_is_all_told_at_once(tmp_path):
    found = faults(
        tmp_path,
        {
            "conventions.strehl": "ratio",
            "conventions.pointing_loss": "pattern",
            "beacon.strehl": 1.2,
            "beacon.divergence": "10 urad",
            "answer.strehl": 1.3,
            "answer.divergence": "5 urad",
            "communication.strehl": 1.4,
        },
    )
    named = {f"{link}.{key}" for link in ("beacon", "answer") for key in ("strehl", "divergence")}
    assert set(found) == named | {"communication.strehl", "conventions.pointing_loss"}


# ---- which file is read as what
@pytest.mark.promise("link-1", "link-4")
def test_links_load_without_a_mirror_and_without_beacon_and_answer(tmp_path):
    file = link_file(tmp_path)
    assert type(file.mission) is LinkMission
    assert file.sources["communication.distance"].value == '"42000 km"'
    bare = link_file(tmp_path, dict.fromkeys(("beacon", "answer", "acquisition", "point_ahead"))).mission
    assert (bare.beacon, bare.answer, bare.acquisition, bare.point_ahead) == (None, None, None, None)


@pytest.mark.parametrize("table", ["terminals", "conventions", "communication", "requirement"])
def test_a_link_is_nothing_without_these_tables(tmp_path, table):
    found, text = the_fault(tmp_path, {table: None})
    assert found == table
    assert text.startswith("is missing: a table with the keys ")


@pytest.mark.promise("link-4")
def test_what_nothing_reads_may_be_left_out(tmp_path):
    gone = dict.fromkeys(("beacon", "answer", "acquisition", "pointing", "conventions.divergence"))
    assert link_file(tmp_path, gone).mission.pointing is None
    for key in ("pointing", "conventions.divergence", "conventions.strehl"):
        found, text = the_fault(tmp_path, {key: None})
        assert found == key
        assert text.startswith("is missing, and ")
    assert link_file(tmp_path, {"requirement.outage": None}).mission.requirement.outage is None
    jitter = {"jitter": {"bias": ["0 urad", "0 urad"], "rms": ["5 urad", "5 urad"], "bandwidth": "50 Hz"}}
    found, text = the_fault(tmp_path, {"requirement.outage": None, **jitter})
    assert found == "requirement.outage"
    assert text.startswith("is missing, and the margin under the table jitter is the one that is kept but for it")
    without = {**gone, "conventions.strehl": None, "communication.strehl": None}
    m = link_file(tmp_path, {**without, "communication.wavefront_error": "60 nm"}).mission
    assert (m.conventions.strehl, m.conventions.divergence) == ("unused", "unused")


def test_a_whole_mission_is_read_for_its_links(tmp_path):
    file = load_link(SHIPPED)
    assert isinstance(file.mission, Mission)
    assert file.path == SHIPPED
    assert file.sources["communication.transmit_power"].kind == "paper"


def test_a_file_with_some_of_the_mirrors_tables_is_checked_as_a_whole_mission(tmp_path):
    amplifier = {"gain": 12.0, "output_min": "0 V", "output_max": "150 V", "bandwidth": "1 kHz", "slew": "1 V/us"}
    found = faults(tmp_path, {"amplifier": amplifier})
    assert {"mirror", "control", "scenario"} <= set(found)
    assert {"conventions.residual", "conventions.mirror_angle", "requirement.residual_statistic"} <= set(found)
    assert all("is missing" in text for text in found.values())


def test_a_whole_missions_keys_are_no_keys_of_links_alone(tmp_path):
    found, text = the_fault(tmp_path, {"conventions.residual": "per-axis"})
    assert found == "conventions.residual"
    assert text.startswith("is no key of [conventions]")


def test_point_ahead_of_the_link_and_of_the_mirror_agree(tmp_path):
    text = SHIPPED.read_text(encoding="utf-8")
    path = tmp_path / "mission.toml"
    for velocity, fits in (("10.65 km/s", True), ("10.5 km/s", True), ("9 km/s", False), ("0 m/s", False)):
        path.write_text(text.replace('"10.65 km/s"', f'"{velocity}"'), encoding="utf-8")
        if fits:
            assert load_link(path).mission.point_ahead is not None
            continue
        found = faults_of(path)
        assert set(found) == {"fine_pointing.reference.point_ahead"}
        assert "is not 2 v / c of point_ahead.transverse_velocity" in found["fine_pointing.reference.point_ahead"]
    path.write_text(without_fine_pointing(text).replace('"10.65 km/s"', '"9 km/s"'), encoding="utf-8")
    assert load_link(path).mission.fine_pointing is None


def test_the_largest_data_rate_is_read_as_one_to_be_solved_for(tmp_path):
    assert math.isnan(link_file(tmp_path, {"communication.data_rate": "largest"}).mission.communication.data_rate_bit_s)


# ---- for editors
@pytest.mark.promise("link-4")
@pytest.mark.parametrize("schema", [LinkMission.model_json_schema(by_alias=True), mission_schema()])
def test_the_schema_describes_the_links_keys(schema):
    tables = schema["$defs"]
    assert {"channel", "jitter", "point_ahead", "acquisition"} <= schema["properties"].keys()
    assert not {"channel", "jitter", "point_ahead", "acquisition"} & set(schema["required"])
    assert {"receiver", "beam", "wavefront_error", "receiver_sensitivity"} <= tables["Communication"][
        "properties"
    ].keys()
    assert {"leo_obscuration", "geo_obscuration", "leo_name"} <= tables["Terminals"]["properties"].keys()
    keys = {"zenith_transmission", "aerosol_depth", "angstrom_exponent", "absorption", "elevation", "altitude"}
    assert keys | {"station", "height", "turbulence"} == tables["Channel"]["properties"].keys()
    receiver = tables["Receiver"]["properties"]
    others = {"background", "code", "inter_symbol_loss"}
    assert {key for table in RECEIVERS.values() for key in table} | others == receiver.keys()
    assert receiver["detector"]["enum"] == [
        "photon-counting",
        "pin",
        "apd",
        "preamplified",
        "homodyne",
        "heterodyne",
    ]
    assert not {"code", "code_gain", "code_rate", *OPTIONAL} & set(tables["Receiver"]["required"])
    assert receiver["bit_error_ratio"]["exclusiveMaximum"] == 0.5
    assert receiver["bit_error_ratio"]["minimum"] == 1e-18
    assert {"const": "largest"} in tables["Communication"]["properties"]["data_rate"]["anyOf"]
    assert all(
        "description" in each or "$ref" in str(each) or "enum" in each
        for key, each in tables["Communication"]["properties"].items()
        if key in ("receiver", "beam", "data_rate", "wavefront_error")
    )


def test_the_example_of_a_bit_error_ratio_is_one_that_links_have():
    name, rule = Receiver.rule_of("bit_error_ratio")
    assert (name, rule.example) == ("bit_error_ratio", "1e-09")
    assert rule.wanted == "a number without quotes, at least 1e-18 and below 0.5"


def test_a_fault_beside_a_missing_extinction_ratio_is_told(tmp_path):
    """The largest gain of a code was computed for marks that are like spaces."""
    found = faults(tmp_path, received_with("pin ook", extinction_ratio=None, background_power=[1]))
    assert "communication.receiver.background_power" in found


# ---- phases
@pytest.mark.promise("link-92")
@pytest.mark.parametrize(("name", "limit"), [("heterodyne bpsk", 0.32112), ("heterodyne qpsk", 0.16523)])
def test_a_phase_error_with_a_floor_above_the_ratio_is_refused_with_the_largest(tmp_path, name, limit):
    # a normal deviate of 1e-6 beyond pi / 4 to one side, of 0.5e-6 beyond pi / 2 to each
    found, text = the_fault(tmp_path, received_with(name, phase_error="0.4 rad"))
    assert found == "communication.receiver.phase_error"
    modulation = RECEIVERS[name]["modulation"]
    assert text.startswith(f'leaves no power that reaches bit_error_ratio = 1e-06 with modulation = "{modulation}": ')
    largest = re.search(r'at most "([^"]+)" rms', text).group(1)
    assert parse_quantity(largest, "rad") == pytest.approx(limit, rel=2e-3)
    assert link_file(tmp_path, received_with(name, phase_error=largest)).mission
    assert the_fault(tmp_path, received_with(name, phase_error=f"{limit * 1.01:.4f} rad"))[0] == found


ALL_OF_A_LINK = {
    "a pointing without lines": (
        lambda: made(Pointing, lines={}).problems(),
        """lines holds no error: expected a table such as [pointing.lines.body_pointing]""",
    ),
    "a jitter about one axis and three": (
        lambda: made(JitterTable, bias_rad=(1e-6,), rms_rad=(1e-6, 2e-6, 3e-6)).problems(),
        """
        bias has 1 item: expected two, for x and y: bias = ["1 urad", "1 urad"]; rms has 3 items: expected two, for
        x and y: rms = ["1 urad", "1 urad"]
        """,
    ),
    "an even beam with a radius": (
        lambda: made(BeamShape, profile="uniform", radius_m=0.02, m_squared=1.0).problems(),
        """
        radius does not belong to profile = "uniform": expected this line removed, or profile = "gaussian";
        m_squared does not belong to profile = "uniform": expected this line removed, or profile = "gaussian"
        """,
    ),
    "a gaussian beam of no size": (
        lambda: made(BeamShape, profile="gaussian").problems(),
        """
        radius is missing, and profile = "gaussian" needs it: expected radius = "2 cm" would do; m_squared is
        missing, and profile = "gaussian" needs it: expected m_squared = 1.1 would do
        """,
    ),
    "a beam of two qualities, the second beyond a quarter wave": (
        lambda: made(Beam, strehl=0.4, wavefront_error_m=260.5e-9, wavelength_m=1.04e-6).problems(),
        """
        strehl stands beside wavefront_error: expected one of the two removed; wavefront_error is above a quarter of
        the wavelength (260 nm): such a beam has no core to point: expected at most 260 nm
        """,
    ),
    "a beam whose limit has five digits, told so that it is kept": (
        lambda: made(Beam, wavefront_error_m=390e-9, wavelength_m=1.551e-6).problems(),
        """
        wavefront_error is above a quarter of the wavelength (387.7 nm): such a beam has no core to point: expected at
        most 387.7 nm
        """,
    ),
    "a beam of no quality": (
        lambda: made(Beam, wavelength_m=1.04e-6).problems(),
        """strehl is missing, and so is wavefront_error: expected strehl = 0.4 would do""",
    ),
    "a detector of another modulation": (
        lambda: made(Receiver, modulation="bpsk", detector="apd").problems(),
        """
        detector does not receive modulation = "bpsk": expected detector = "homodyne" or detector = "heterodyne"
        """,
    ),
    "a counter of pulse positions without anything": (
        lambda: made(Receiver, modulation="ppm", detector="photon-counting", bit_error_ratio=1e-6).problems(),
        """
        background_power is missing, and modulation = "ppm", detector = "photon-counting" needs it: expected
        background_power = "0 pW" would do; order is missing, and modulation = "ppm", detector = "photon-counting"
        needs it: expected order = 16 would do; efficiency is missing, and modulation = "ppm", detector =
        "photon-counting" needs it: expected efficiency = 0.5 would do; dark_count_rate is missing, and modulation =
        "ppm", detector = "photon-counting" needs it: expected dark_count_rate = "1000 1/s" would do; code_gain is
        missing, and so is code: expected code_gain = "0 dB" would do without a code; code_rate is missing, and so
        is code: expected code_rate = 1.0 would do without a code
        """,
    ),
    "a counter under a sky with what others have": (
        lambda: made(
            Receiver,
            modulation="ook",
            detector="photon-counting",
            bit_error_ratio=1e-6,
            code_gain_db=1.0,
            code_rate=0.5,
            background=1,
            background_power_w=0.0,
            order=12,
            extinction_ratio_db=0.0009,
            efficiency=0.5,
            dark_current_a=0.0,
            avalanche_gain=2.0,
            polarisations=1,
        ).problems(),
        """
        order does not belong to modulation = "ook", detector = "photon-counting": expected this line removed;
        dark_count_rate is missing, and modulation = "ook", detector = "photon-counting" needs it: expected
        dark_count_rate = "1000 1/s" would do; dark_current does not belong to modulation = "ook", detector =
        "photon-counting": expected this line removed; avalanche_gain does not belong to modulation = "ook",
        detector = "photon-counting": expected this line removed; polarisations does not belong to modulation =
        "ook", detector = "photon-counting": expected this line removed; background_power stands beside the table
        background: expected one of the two removed; extinction_ratio is below 0.001 dB, where marks and spaces are
        alike: expected extinction_ratio = "20 dB" would do; order is no power of two: expected order = 16 would do
        """,
    ),
    "an amplified switch without its filter": (
        lambda: made(
            Receiver,
            modulation="ook",
            detector="preamplified",
            bit_error_ratio=1e-6,
            code_gain_db=1.0,
            code_rate=0.5,
            background_power_w=0.0,
            thermal_noise_a_sqrt_hz=0.0,
            ionisation_ratio=0.0,
        ).problems(),
        """
        background_power does not belong to modulation = "ook", detector = "preamplified": expected this line
        removed; extinction_ratio is missing, and modulation = "ook", detector = "preamplified" needs it: expected
        extinction_ratio = "20 dB" would do; thermal_noise does not belong to modulation = "ook", detector =
        "preamplified": expected this line removed; ionisation_ratio does not belong to modulation = "ook", detector
        = "preamplified": expected this line removed; noise_figure is missing, and modulation = "ook", detector =
        "preamplified" needs it: expected noise_figure = "4 dB" would do; amplifier_gain is missing, and modulation
        = "ook", detector = "preamplified" needs it: expected amplifier_gain = "35 dB" would do; optical_bandwidth
        is missing, and modulation = "ook", detector = "preamplified" needs it: expected optical_bandwidth = "20
        GHz" would do
        """,
    ),
    "an avalanche diode without anything": (
        lambda: made(Receiver, modulation="ook", detector="apd", bit_error_ratio=1e-6, code="none of these").problems(),
        """
        background_power is missing, and modulation = "ook", detector = "apd" needs it: expected background_power =
        "0 pW" would do; extinction_ratio is missing, and modulation = "ook", detector = "apd" needs it: expected
        extinction_ratio = "20 dB" would do; efficiency is missing, and modulation = "ook", detector = "apd" needs
        it: expected efficiency = 0.8 would do; dark_current is missing, and modulation = "ook", detector = "apd"
        needs it: expected dark_current = "1 nA" would do; thermal_noise is missing, and modulation = "ook",
        detector = "apd" needs it: expected thermal_noise = "2 pA/sqrt(Hz)" would do; avalanche_gain is missing, and
        modulation = "ook", detector = "apd" needs it: expected avalanche_gain = 20.0 would do; ionisation_ratio is
        missing, and modulation = "ook", detector = "apd" needs it: expected ionisation_ratio = 0.2 would do; code
        is "none of these", which is no code that is known here: expected code = "ccsds-k7-1-2" or code =
        "dvb-s2-1-4" or code = "dvb-s2-1-3" or code = "dvb-s2-2-5" or code = "dvb-s2-1-2" or code = "dvb-s2-3-5" or
        code = "dvb-s2-2-3" or code = "dvb-s2-3-4" or code = "dvb-s2-4-5" or code = "dvb-s2-5-6" or code =
        "dvb-s2-8-9" or code = "dvb-s2-9-10" or code = "scppm-1-2"
        """,
    ),
    "an oscillator without efficiency and with much too large a phase error": (
        lambda: made(
            Receiver,
            modulation="qpsk",
            detector="homodyne",
            bit_error_ratio=2e-5,
            code="sda-1-2",
            code_gain_db=0.0,
            code_rate=1.0,
            phase_error_rad=0.5,
            noise_figure_db=4.0,
        ).problems(),
        """
        efficiency is missing, and modulation = "qpsk", detector = "homodyne" needs it: expected efficiency = 0.8
        would do; noise_figure does not belong to modulation = "qpsk", detector = "homodyne": expected this line
        removed; code_gain stands beside code, which has its own: expected one of the two removed; code_rate stands
        beside code, which has its own: expected one of the two removed; code is a code for ook (SDA optical
        communications terminal standard 4.0.0, which prints no threshold), not for qpsk: expected another code, or
        code_gain and code_rate in its place; phase_error leaves no power that reaches bit_error_ratio = 2e-05 with
        modulation = "qpsk": expected at most "191 mrad" rms, or another bit_error_ratio
        """,
    ),
    "two phases with the phase error of a lock that is lost": (
        lambda: made(
            Receiver,
            modulation="bpsk",
            detector="heterodyne",
            bit_error_ratio=3e-4,
            efficiency=0.5,
            code_gain_db=0.0,
            code_rate=1.0,
            phase_error_rad=0.9,
        ).problems(),
        """
        phase_error leaves no power that reaches bit_error_ratio = 0.0003 with modulation = "bpsk": expected at most
        "434.1 mrad" rms, or another bit_error_ratio
        """,
    ),
    "a fading without a series": (
        lambda: made(
            Fading, unit="dB", normalised="mean", channel="a", sampling_s=0.1, interleaving="none", interleaver_s=0.01
        ).problems(),
        """
        unit stands without a series: expected this line removed, or series with a file; normalised stands without a
        series: expected this line removed, or series with a file; channel stands without a series: expected this
        line removed, or series with a file; sampling stands without a series: expected this line removed, or series
        with a file; interleaver does not belong to interleaving = "none": expected this line removed, or
        interleaving = "block"
        """,
    ),
    "a series that says nothing of itself": (
        lambda: made(Fading, series="a.csv", interleaving="convolutional").problems(),
        """
        unit is missing, and series needs it: expected unit = "linear" would do; normalised is missing, and series
        needs it: expected normalised = "mean" would do; interleaver is missing, and interleaving = "convolutional"
        needs it: expected interleaver = "10 ms" would do
        """,
    ),
    "a link with two receivers, and a second ratio for its fades": (
        lambda: made(
            Communication,
            strehl=0.4,
            wavelength_m=1e-6,
            receiver_sensitivity_photon_bit=50.0,
            receiver=SimpleNamespace(modulation="ook", extinction_ratio_db=0.0, code_gain_db=90.0),
            fading=SimpleNamespace(bit_error_ratio=1e-6),
        ).problems(),
        """
        receiver_sensitivity stands beside the table receiver: expected one of the two removed;
        fading.bit_error_ratio stands beside that of the table receiver: expected this line removed; fading.code is
        of BPSK, and the receiver has modulation = "ook": expected modulation = "bpsk", or a measured
        receiver_sensitivity
        """,
    ),
    "a link with no receiver, and no ratio for its fades": (
        lambda: made(
            Communication, strehl=0.4, wavelength_m=1e-6, fading=SimpleNamespace(bit_error_ratio=None)
        ).problems(),
        """
        receiver_sensitivity is missing, and so is the table receiver: expected receiver_sensitivity = "100
        photon/bit" would do, or a table receiver; fading.bit_error_ratio is missing, and so is the table receiver,
        which has one: expected bit_error_ratio = 1e-6 would do
        """,
    ),
    "a link with light that has no core to couple": (
        lambda: made(
            Communication,
            strehl=0.4,
            wavelength_m=1.54e-6,
            receiver_sensitivity_photon_bit=50.0,
            coupling=made(Coupling, defocus_m=0.77e-6, astigmatism_m=-0.78e-6, coma_m=0.8e-6, spherical_m=-0.76e-6),
        ).problems(),
        """
        coupling.astigmatism is above half the wavelength (770 nm): such light has no core to couple: expected at
        most 770 nm; coupling.coma is above half the wavelength (770 nm): such light has no core to couple: expected
        at most 770 nm
        """,
    ),
    "light without a core, of a wavelength of six digits": (
        lambda: made(Coupling, coma_m=0.8e-6).wavefront_problems(1.55038e-6),
        """
        coupling.coma is above half the wavelength (775.1 nm): such light has no core to couple: expected at most 775.1
        nm
        """,
    ),
    "a code that gains more than any": (
        lambda: made(
            Communication,
            strehl=0.4,
            wavelength_m=1e-6,
            data_rate_bit_s=622.08e6,
            receiver=made(
                Receiver,
                modulation="bpsk",
                detector="homodyne",
                bit_error_ratio=2.5e-7,
                code_gain_db=11.375,
                code_rate=0.4375,
            ),
        ).problems(),
        """
        receiver.code_gain is more than any code can gain: 11.1 dB at code_rate = 0.4375 and bit_error_ratio =
        2.5e-07, where bpsk with homodyne is at its capacity: expected at most "11.09 dB" at code_rate = 0.4375: the
        net gain, power per bit
        """,
    ),
    "a fibre of one mode with what the others have": (
        lambda: made(
            Coupling,
            into="single-mode fibre",
            mode_radius_m=5e-6,
            core_radius_m=1e-5,
            detector_radius_m=1e-5,
            numerical_aperture=0.1,
        ).problems(),
        """
        core_radius does not belong to into = "single-mode fibre": expected this line removed, or into = "multi-mode
        fibre"; numerical_aperture does not belong to into = "single-mode fibre": expected this line removed, or
        into = "multi-mode fibre"; detector_radius does not belong to into = "single-mode fibre": expected this line
        removed, or into = "detector"; focal_length is missing, and into = "single-mode fibre" needs it: expected
        focal_length = "50 cm" would do
        """,
    ),
    "a fibre of one mode without it, off its place": (
        lambda: made(Coupling, into="single-mode fibre", lateral_error_m=1e-6).problems(),
        """
        mode_radius is missing, and into = "single-mode fibre" needs it: expected mode_radius = "best" would do;
        focal_length is missing, and into = "single-mode fibre" needs it: expected focal_length = "50 cm" would do
        """,
    ),
    "a fibre of one mode, turned": (
        lambda: made(
            Coupling,
            into="single-mode fibre",
            mode_radius_m=math.nan,
            angular_error_rad=1e-3,
            twin=True,
            pointing_error_rad=0.0,
        ).problems(),
        """
        focal_length is missing, and into = "single-mode fibre" needs it: expected focal_length = "50 cm" would do;
        pointing_error stands beside twin: both say how the receiver points: expected one of the two
        """,
    ),
    "a fibre of many modes with a mode": (
        lambda: made(
            Coupling,
            into="multi-mode fibre",
            mode_radius_m=5e-6,
            angular_error_rad=0.0,
            coma_m=0.0,
            jitter=0,
            pointing_error_rad=0.0,
        ).problems(),
        """
        mode_radius does not belong to into = "multi-mode fibre": expected this line removed, or into = "single-mode
        fibre"; core_radius is missing, and into = "multi-mode fibre" needs it: expected core_radius = "25 um" would
        do; numerical_aperture is missing, and into = "multi-mode fibre" needs it: expected numerical_aperture = 0.2
        would do; focal_length is missing, and into = "multi-mode fibre" needs it: expected focal_length = "50 cm"
        would do; angular_error does not belong to into = "multi-mode fibre": expected this line removed, or into =
        "single-mode fibre"; pointing_error stands beside jitter: both say how the receiver points: expected one of
        the two
        """,
    ),
    "a detector with a twin and a jitter": (
        lambda: made(
            Coupling, into="detector", numerical_aperture=0.1, focal_length_m=0.5, twin=True, jitter=0
        ).problems(),
        """
        numerical_aperture does not belong to into = "detector": expected this line removed, or into = "multi-mode
        fibre"; detector_radius is missing, and into = "detector" needs it: expected detector_radius = "50 um" would
        do; jitter stands beside twin: both say how the receiver points: expected one of the two
        """,
    ),
    "a strehl without a convention": (
        lambda: strehl_fits("answer")(SimpleNamespace(strehl="unused"), SimpleNamespace(strehl=0.4)),
        """
        conventions.strehl is missing, and answer.strehl is read by it: expected strehl = "ratio" for a number up to
        1, or "decibel"
        """,
    ),
    "a strehl ratio above one": (
        lambda: strehl_fits("beacon")(SimpleNamespace(strehl="ratio"), SimpleNamespace(strehl=1.0625)),
        """
        beacon.strehl is no ratio, but conventions.strehl = "ratio" (1.0625): expected above 0 and at most 1, or
        conventions.strehl = "decibel"
        """,
    ),
    "a divergence without a convention": (
        lambda: divergence_fits("answer", "geo")(
            SimpleNamespace(divergence="unused"), SimpleNamespace(), SimpleNamespace()
        ),
        """
        conventions.divergence is missing, and answer.divergence is read by it: expected divergence = "full-1/e2"
        for the full angle at 1/e2, or "half-1/e2"
        """,
    ),
    "a full angle below diffraction": (
        lambda: divergence_fits("beacon", "leo")(
            SimpleNamespace(divergence="full-1/e2"),
            SimpleNamespace(leo_aperture_m=0.05, geo_aperture_m=5.0),
            SimpleNamespace(wavelength_m=8e-7, divergence_rad=2.5e-5),
        ),
        """
        beacon.divergence is below diffraction at leo_aperture = 50 mm, which leaves no less than 28.84 µrad (full
        angle at 1/e2): expected at least "28.84 µrad", or a larger aperture
        """,
    ),
    "a half angle below diffraction": (
        lambda: divergence_fits("answer", "geo")(
            SimpleNamespace(divergence="half-1/e2"),
            SimpleNamespace(leo_aperture_m=50.0, geo_aperture_m=0.25),
            SimpleNamespace(wavelength_m=1.06e-6, divergence_rad=3.5e-6),
        ),
        """
        answer.divergence is below diffraction at geo_aperture = 250 mm, which leaves no less than 3.821 µrad (half
        angle at 1/e2): expected at least "3.821 µrad", or a larger aperture
        """,
    ),
    "a pattern of no beam": (
        lambda: pattern_fits(SimpleNamespace(pointing_loss="pattern"), SimpleNamespace(beam=None)),
        """
        conventions.pointing_loss needs the table communication.beam, which is missing: expected pointing_loss =
        "gaussian", or a table [communication.beam]
        """,
    ),
    "a beam without a pattern": (
        lambda: pattern_fits(SimpleNamespace(pointing_loss="gain"), SimpleNamespace(beam=0)),
        """
        conventions.pointing_loss does not take communication.beam into account ("gain"): expected pointing_loss =
        "pattern"
        """,
    ),
    "a beam within its obscuration": (
        lambda: obscuration_fits(
            SimpleNamespace(leo_obscuration=0.4375, leo_aperture_m=0.25),
            SimpleNamespace(beam=SimpleNamespace(radius_m=0.03)),
        ),
        """
        communication.beam.radius leaves less than 1 % of the beam beside leo_obscuration = 0.4375: expected at
        least "36.08 mm", or a smaller obscuration
        """,
    ),
    "a beacon without pointing errors": (
        lambda: _cone_fits(None, SimpleNamespace()),
        """
        pointing is missing, and the cone of the beacon is judged by its errors: expected the table [pointing] with
        its lines, or no beacon
        """,
    ),
    "a jitter without an outage": (
        lambda: _outage_given(SimpleNamespace(), SimpleNamespace(outage=None)),
        """
        requirement.outage is missing, and the margin under the table jitter is the one that is kept but for it:
        expected a share of the time, outage = 0.003 for 0.3 %
        """,
    ),
    "a cone within the obscuration, and no outage for a twin": (
        lambda: _coupling_fits(
            SimpleNamespace(geo_obscuration=0.5, geo_aperture_m=0.25),
            SimpleNamespace(
                wavelength_m=1e-6, coupling=made(Coupling, numerical_aperture=0.125, focal_length_m=0.4375, twin=True)
            ),
            SimpleNamespace(outage=None),
        ),
        """
        communication.coupling.numerical_aperture leaves 110.2 mm of the aperture, no more than
        terminals.geo_obscuration stops: expected a larger one, or a longer focal_length; requirement.outage is
        missing, and the margin under the receiver's jitter is the one that is kept but for it: expected a share of
        the time, outage = 0.003 for 0.3 %
        """,
    ),
    "a fibre that is turned too far for its mode": (
        lambda: _coupling_fits(
            SimpleNamespace(geo_obscuration=None, geo_aperture_m=0.25),
            SimpleNamespace(
                wavelength_m=1.55e-6,
                coupling=made(Coupling, angular_error_rad=0.7, mode_radius_m=5e-6, focal_length_m=0.75),
            ),
            SimpleNamespace(outage=None),
        ),
        """
        communication.coupling.angular_error turns the fibre's mode out of the aperture: beyond 668.2 mrad it takes
        no light to speak of: expected at most 668.2 mrad
        """,
    ),
    "a fibre that is turned too far for the best mode": (
        lambda: _coupling_fits(
            SimpleNamespace(geo_obscuration=None, geo_aperture_m=0.25),
            SimpleNamespace(
                wavelength_m=1.55e-6,
                coupling=made(Coupling, angular_error_rad=0.96, mode_radius_m=math.nan, focal_length_m=0.75),
            ),
            SimpleNamespace(outage=0.01),
        ),
        """
        communication.coupling.angular_error turns the fibre's mode out of the aperture: beyond 871.6 mrad it takes
        no light to speak of: expected at most 871.6 mrad
        """,
    ),
    "two point-aheads": (
        lambda: _point_ahead_fits(
            SimpleNamespace(transverse_velocity_m_s=8125.0),
            SimpleNamespace(reference=SimpleNamespace(point_ahead_rad=53e-6)),
        ),
        """
        fine_pointing.reference.point_ahead is not 2 v / c of point_ahead.transverse_velocity (54.2 µrad): expected
        point_ahead = "54.2 µrad" would do
        """,
    ),
    "a budget of a loop that is not there": (
        lambda: _loop_there(SimpleNamespace(with_loop=True), None),
        """
        error_budget.with_loop is true, and the mission has no table fine_pointing: expected the table
        [fine_pointing], which microrad init writes, or false
        """,
    ),
}


@pytest.mark.parametrize("what", ALL_OF_A_LINK)
def test_all_that_does_not_fit_in_a_table_of_a_link_is_told_in_full(what):
    problems, words = ALL_OF_A_LINK[what]
    assert told(problems()) == one_line(words)


def counted(**changes):
    """A counter of switched light behind a background, with a code of its own."""
    given = {"modulation": "ook", "detector": "photon-counting", "bit_error_ratio": 2.5e-7, "code_rate": 0.4375}
    given |= {"efficiency": 0.625, "dark_count_rate_1_s": 1250.0, "background_power_w": 2.5e-12, "code_gain_db": 3.25}
    return made(Receiver, **given | changes)


def test_counts_without_signal_are_those_of_background_and_dark_for_each_bit():
    energy_j = 6.62607015e-34 * 299792458.0 / 1.55e-6
    wanted = (0.625 * 2.5e-12 / energy_j + 1250.0) / 622.08e6
    assert counted()._counts(622.08e6, 1.55e-6) == pytest.approx(wanted, rel=1e-12)
    assert counted(dark_count_rate_1_s=None)._counts(622.08e6, 1.55e-6) < wanted
    for without in (counted(background_power_w=None)._counts(1e9, 1e-6), counted()._counts(0.0, 1e-6)):
        assert without is None
    assert counted()._counts(math.nan, 1e-6) is None


@pytest.mark.parametrize(
    ("changes", "gain"),
    [
        ({"extinction_ratio_db": 20.0}, 13.60899),
        ({"extinction_ratio_db": 6.25}, 15.93785),
        ({"detector": "apd", "avalanche_gain": 12.5, "ionisation_ratio": 0.375, "extinction_ratio_db": 9.5}, 86.94516),
        ({"detector": "pin", "extinction_ratio_db": 9.5}, 17.78987),
        ({"modulation": "dpsk", "detector": "preamplified"}, 15.22188),
        ({"detector": "preamplified"}, 10.26689),
        ({"modulation": "qpsk", "detector": "homodyne"}, 12.88197),
        ({"modulation": "ppm", "order": 32}, 11.0323),
        ({"modulation": "ppm", "order": 32, "code_rate": None}, 1.204021),
    ],
)
def test_the_most_that_a_code_can_gain_is_that_of_its_receiver(changes, gain):
    assert counted(**changes).most_code_gain(622.08e6, 1.55e-6) == pytest.approx(gain, rel=1e-5)


def test_rate_and_gain_of_a_code_are_its_own_by_name_and_those_given_else():
    given, none = counted(), counted(code_rate=None, code_gain_db=None)
    assert (given.rate_of_code, given.net_gain_db, given.named_code) == (0.4375, 3.25, None)
    assert (none.rate_of_code, none.net_gain_db) == (1.0, 0.0)
    named = counted(code="dvb-s2-3-4", bit_error_ratio=1e-7)
    assert named.rate_of_code == named.named_code.rate == pytest.approx(0.743737, rel=1e-6)
    assert named.net_gain_db == named.named_code.net_gain_db(1e-7)
    assert counted(code="scppm-1-2").net_gain_db == 0.0 and counted(code="none").named_code is None


@pytest.mark.parametrize(
    ("modulation", "ratio", "error", "reaches"),
    [
        ("bpsk", 3e-4, 0.434, True),
        ("bpsk", 3e-4, 0.436, False),
        ("qpsk", 3e-4, 0.434, False),
        ("qpsk", 2e-5, 0.19, True),
        ("qpsk", 2e-5, 0.193, False),
        ("dpsk", 3e-4, 1.0, True),
        ("bpsk", 1e-18, None, True),
    ],
)
def test_a_phase_error_leaves_its_ratio_in_reach_or_not(modulation, ratio, error, reaches):
    assert counted(modulation=modulation, bit_error_ratio=ratio, phase_error_rad=error).reaches_ratio is reaches


@pytest.mark.parametrize(("given", "needs"), [
    ({}, False),
    ({"mode_radius_m": math.nan, "lateral_error_m": 0.0, "angular_error_rad": 0.0}, False),
    ({"mode_radius_m": math.nan, "lateral_error_m": -1e-9}, True),
    ({"mode_radius_m": math.nan, "angular_error_rad": 1e-9}, True),
    ({"mode_radius_m": 5e-6, "lateral_error_m": 0.0}, True),
    ({"mode_radius_m": 5e-6, "angular_error_rad": 1e-9, "lateral_error_m": 1e-9, "focal_length_m": 0.5}, False),
])  # fmt: skip
def test_a_fibre_of_one_mode_needs_its_telescope_where_a_length_or_an_angle_is_off(given, needs):
    found = made(Coupling, into="single-mode fibre", **({"mode_radius_m": math.nan} | given)).problems()
    missing = 'is missing, and into = "single-mode fibre" needs it'
    wanted = [("focal_length", missing, 'focal_length = "50 cm" would do')] if needs else []
    assert [(each.key, each.reason, each.expected) for each in found] == wanted


def test_links_are_read_from_a_text_in_place_of_a_file_that_need_not_be_there(tmp_path):
    path = written(tmp_path, data_with({}))
    text = path.read_text(encoding="utf-8")
    other = text.replace('margin = "3 dB"', 'margin = "2.5 dB"  # agreed', 1)
    assert other != text
    for place in (path, tmp_path / "nowhere" / "links.toml"):
        file = load_link(place, text=other)
        assert (file.path, file.text, file.mission.requirement.margin_db) == (place, other, 2.5)
        assert file.sources["requirement.margin"].text == "agreed"
    assert load_link(path).mission.requirement.margin_db == 3.0
    with pytest.raises(MissionError) as refused:
        load_link(tmp_path / "nowhere" / "links.toml", text=text.replace('margin = "3 dB"', 'margin = "3 s"', 1))
    (fault,) = refused.value.faults
    assert (fault.key, fault.value, fault.file) == (
        "requirement.margin",
        '"3 s"',
        str(tmp_path / "nowhere" / "links.toml"),
    )


@pytest.mark.parametrize(
    ("given", "light", "is_random"),
    [
        (
            {"into": "detector", "detector_radius_m": 5e-5, "focal_length_m": 0.5, "lateral_error_m": 0.0},
            *("into detector_radius focal_length lateral_error", False),
        ),
        (
            {"into": "single-mode fibre", "mode_radius_m": math.nan, "coma_m": -1e-8, "pointing_error_rad": 0.0},
            *("into mode_radius coma", False),
        ),
        (
            {"into": "multi-mode fibre", "spherical_m": 0.0, "jitter": 0, "angular_error_rad": 0.0, "twin": False},
            *("into angular_error spherical", True),
        ),
        ({"into": "detector", "astigmatism_m": 0.0, "defocus_m": 1e-8, "twin": True}, "into defocus astigmatism", True),
        ({"into": "detector", "twin": False}, "into", False),
    ],
)
def test_what_takes_the_light_is_said_by_all_keys_but_those_of_how_the_receiver_points(given, light, is_random):
    table = made(Coupling, **given)
    assert " ".join(table.keys_of_light) == light
    assert table.is_random is is_random


def test_a_strehl_and_a_wavefront_error_of_nought_are_there():
    for given, words in (
        ({"strehl": 0.0}, ""),
        ({"wavefront_error_m": 0.0}, ""),
        ({"wavefront_error_m": 0.375e-6}, ""),
        ({"strehl": 0.0, "wavefront_error_m": 0.0}, "strehl stands beside wavefront_error: expected one of the two"),
        ({}, "strehl is missing, and so is wavefront_error: expected strehl = 0.4 would do"),
    ):
        found = told(made(Beam, wavelength_m=1.5e-6, **given).problems())
        assert found.startswith(words) and bool(found) is bool(words)
