"""Each input of a link a little down and up: every swing by hand, within its bounds, the largest first."""

import math
import random
from dataclasses import replace

import pytest

import budgets
from link_files import GAUSSIAN, PATTERN, RECEIVERS, SKY, link_file, received_with
from microrad import link
from microrad.link import study as link_study
from microrad.link import variation
from microrad.link.pointing import outage as link_performance
from microrad.link.variation import RELATIVE, STEP_DB
from microrad.mission.fields import Quantity, Share
from microrad.mission.file import load_link
from shipped import SHIPPED

HALF = 2 * 1.55e-6 / (math.pi * 0.05)
CHANNEL = {"channel": {"zenith_transmission": 0.8, "elevation": "30 deg"}}
LEFT = {"point_ahead.corrected": False, "point_ahead.transverse_velocity": "1 km/s"}
JITTER = {"jitter": {"bias": ["1 urad", "0 urad"], "rms": ["3 urad", "2 urad"], "bandwidth": "50 Hz"}}
NO_BEAMS = dict.fromkeys(("beacon", "answer", "acquisition"))
WAVEFRONT = {"communication.strehl": None, "communication.wavefront_error": "100 nm"}


def of_communication(file):
    """The tornado of the communication budget."""
    communication = link_study.communication_budget(link.of(file.mission), file.sources)
    return link_study.tornados(file.mission, file.sources, (communication,))[0]


def swings(folder, *changes):
    return {each.key: each for each in of_communication(link_file(folder, *changes)).swings}


def changed(mission, key, value):
    """The mission with one key, given by the name of its field, replaced."""
    *tables, field = key.split(".")
    path = [mission]
    for name in tables:
        path.append(getattr(path[-1], name))
    record = path.pop().model_copy(update={field: value})
    for name, outer in zip(reversed(tables), reversed(path), strict=True):
        record = outer.model_copy(update={name: record})
    return record


def field_of(mission, key):
    """The name of the field that a file calls by this key."""
    table = mission
    *tables, last = key.split(".")
    for name in tables:
        table = getattr(table, name)
    return ".".join([*tables, next(n for n, i in type(table).model_fields.items() if (i.alias or n) == last)])


def margins(swing):
    return swing.margin_low_db, swing.margin_high_db


def up_and_down(factor, share=RELATIVE):
    """Decibels that a product with a factor to a power gains when the factor moves."""
    return tuple(10 * factor * math.log10(1 + sign * share) for sign in (-1, 1))


@pytest.mark.promise("link-10", "link-22")
def test_the_swings_are_those_of_the_formulas(tmp_path):
    found = swings(tmp_path)
    margin = budgets.communication(link_file(tmp_path).mission, {}).margin_db
    lost = 8.685889638 * (10e-6 / HALF) ** 2
    apertures = [up_and_down(2)[i] + lost * (1 - (1 + s * RELATIVE) ** 2) for i, s in ((0, -1), (1, 1))]
    expected = {
        "communication.transmit_power": up_and_down(1),
        "communication.distance": up_and_down(-2),
        "communication.data_rate": up_and_down(-1),
        "communication.receiver_sensitivity": up_and_down(-1),
        "communication.strehl": (STEP_DB * 0.8, -STEP_DB),
        "communication.implementation_loss": (0.0, -STEP_DB),
        "communication.pointing_error": tuple(lost * (1 - (1 + s * RELATIVE) ** 2) for s in (-1, 1)),
        "terminals.leo_aperture": tuple(apertures),
        "terminals.geo_aperture": up_and_down(2),
    }
    for key, (low, high) in expected.items():
        assert margins(found[key]) == pytest.approx((margin + low, margin + high), abs=1e-9), key
        assert found[key].swing_db == pytest.approx(abs(high - low), abs=1e-9)
    losses = {f"communication.{each}_loss" for each in ("transmit_optics", "receive_optics", "tracking_split")}
    assert set(found) == set(expected) | losses | {"communication.wavelength"}


CASES = {
    "as it is": [],
    "pattern": [PATTERN, {"terminals.leo_obscuration": 0.2, "terminals.geo_obscuration": 0.3}],
    "ratio": [{"conventions.strehl": "ratio", "communication.strehl": 0.6}],
    "wavefront, sky and point-ahead": [WAVEFRONT, CHANNEL, LEFT],
    **{name: [received_with(name)] for name in RECEIVERS},
    "sky": [received_with("apd ook", background=SKY, background_power=None)],
}
MORE = ("homodyne qpsk", "heterodyne bpsk", "heterodyne qpsk", "preamplified ook", "counting ook", "pin ook")
"""Receivers that are like another one in the gate."""


@pytest.mark.promise("link-10")
@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=pytest.mark.endurance if name in MORE else ()) for name in CASES]
)
def test_every_swing_is_the_budget_with_one_key_changed(tmp_path, name):
    file = link_file(tmp_path, *CASES[name])
    found = of_communication(file).swings
    sizes = [round(each.swing_db, 6) for each in found]
    assert sizes == sorted(sizes, reverse=True)
    assert len({each.key for each in found}) == len(found)
    for each in found:
        field = field_of(file.mission, each.key)
        assert each.low <= each.value <= each.high
        assert each.low < each.high
        for value, margin in ((each.low, each.margin_low_db), (each.high, each.margin_high_db)):
            assert math.isfinite(margin), each
            mission = changed(file.mission, field, value)
            assert budgets.communication(mission, file.sources).margin_db == pytest.approx(margin, abs=1e-9)
        assert each.swing_db > 1e-9
        assert each.source


def test_the_keys_that_matter_are_those_that_the_link_has(tmp_path):
    sky = swings(tmp_path, *CASES["wavefront, sky and point-ahead"])
    assert {"channel.zenith_transmission", "channel.elevation", "point_ahead.transverse_velocity"} <= sky.keys()
    assert "communication.wavefront_error" in sky
    assert "communication.strehl" not in sky
    pattern = swings(tmp_path, *CASES["pattern"])
    assert {"communication.beam.radius", "communication.beam.m_squared"} <= pattern.keys()
    assert {"terminals.leo_obscuration", "terminals.geo_obscuration"} <= pattern.keys()


@pytest.mark.parametrize("seed", range(4))
def test_equal_swings_stand_as_the_mission_has_their_keys(tmp_path, seed):
    file, draw = link_file(tmp_path, NO_BEAMS), random.Random(seed)

    def as_a_processor_leaves_it(m):
        return link_performance.margin_db(link.of(m)) + draw.uniform(-1e-12, 1e-12)

    found = link.swings(
        file.mission,
        file.sources,
        ("terminals", "communication"),
        "decibel",
        as_a_processor_leaves_it,
        link.beam_passes,
    )
    aperture, distance = (
        next(s for s in found if s.key == k) for k in ("terminals.geo_aperture", "communication.distance")
    )
    assert aperture.swing_db == pytest.approx(distance.swing_db, abs=1e-9)
    assert found.index(distance) == found.index(aperture) + 1


def test_what_does_not_move_the_margin_is_left_out(tmp_path):
    # an obscuration, which no formula of an even light holds, and the outage, which a static error has not
    found = swings(tmp_path, {"terminals.leo_obscuration": 0.2})
    others = ("beacon.", "answer.", "requirement.", "pointing.", "point_ahead.", "jitter.")
    assert not any(key.startswith(others) for key in found)
    assert "terminals.leo_obscuration" not in found
    on_axis = swings(tmp_path, {"communication.pointing_error": "0 urad"})
    assert "communication.pointing_error" not in on_axis


# ---- the other margins
@pytest.mark.parametrize(("name", "end", "other"), [("beacon", "leo", "geo"), ("answer", "geo", "leo")])
def test_the_margin_of_the_other_beams_over_their_own_inputs(tmp_path, name, end, other):
    file = link_file(tmp_path, CHANNEL, LEFT, {f"terminals.{other}_obscuration": 0.3})
    m, budget = file.mission, {"beacon": budgets.beacon, "answer": budgets.answer}[name]
    found = {each.key: each for each in variation.beam_tornado(m, file.sources, name)}
    keys = {f"{name}.{key}" for key in ("transmit_power", "divergence", "pointing_error", "distance", "strehl")}
    keys |= {f"{name}.{key}" for key in ("required_power", "transmit_optics_loss", "receive_optics_loss")}
    keys |= {f"terminals.{other}_{key}" for key in ("aperture", "obscuration")}
    keys |= {"channel.zenith_transmission", "channel.elevation", "point_ahead.transverse_velocity"}
    assert found.keys() == keys  # wavelength and sending aperture are not in the gain of a Gaussian beam
    assert [each.swing_db for each in found.values()] == sorted((s.swing_db for s in found.values()), reverse=True)
    margin = budget(m, file.sources).margin_db
    for key, factor in (("transmit_power", 1), ("required_power", -1), ("distance", -2)):
        low, high = up_and_down(factor)
        assert margins(found[f"{name}.{key}"]) == pytest.approx((margin + low, margin + high), abs=1e-9)
    for each in found.values():
        for value, moved in ((each.low, each.margin_low_db), (each.high, each.margin_high_db)):
            mission = changed(m, field_of(m, each.key), value)
            assert budget(mission, file.sources).margin_db == pytest.approx(moved, abs=1e-9)
    assert not any(key.startswith("communication.") for key in found)


@pytest.mark.promise("link-10")
@pytest.mark.parametrize(("name", "diameter"), [("beacon", 0.05), ("answer", 0.15)])
def test_no_beam_is_moved_below_diffraction(tmp_path, name, diameter):
    least = 2 * math.sqrt(8) * 1.55e-6 / (math.pi * diameter)
    file = link_file(tmp_path, {f"{name}.divergence": f"{1.05 * least * 1e6} urad", f"{name}.pointing_error": "9 urad"})
    found = {each.key: each for each in variation.beam_tornado(file.mission, file.sources, name)}
    moved = found[f"{name}.divergence"]
    assert least <= moved.low < moved.value
    assert moved.low == pytest.approx(1.05 * least * (1 - RELATIVE / 4), rel=1e-9)  # halved twice from 10 %
    assert moved.high == pytest.approx(1.05 * least * (1 + RELATIVE), rel=1e-9)


@pytest.mark.promise("link-5", "link-10")
@pytest.mark.parametrize(
    "changes",
    [
        [],
        pytest.param([PATTERN], marks=pytest.mark.endurance),
        pytest.param([LEFT], marks=pytest.mark.endurance),
        [received_with("apd ook")],
    ],
    ids=["w", "pattern", "ahead", "apd"],
)
def test_the_margin_under_jitter_over_its_inputs(tmp_path, changes):
    file = link_file(tmp_path, JITTER, NO_BEAMS, *changes)
    m = file.mission
    under = of_communication(file)
    assert under.of == "Communication"
    assert under.margin_db == pytest.approx(link_performance.performance_under_jitter(link.of(m)).margin_db, abs=1e-9)
    found = {each.key: each for each in under.swings}
    assert {"jitter.bias.1", "jitter.rms.1", "jitter.rms.2", "requirement.outage"} <= found.keys()
    assert {"communication.transmit_power", "terminals.leo_aperture"} <= found.keys()
    # a bias of 0 has no share to be moved by; the static error and how fast it moves are not in it
    assert (
        not {"jitter.bias.2", "jitter.bandwidth", "communication.pointing_error", "requirement.margin"} & found.keys()
    )
    outage = found["requirement.outage"]
    assert (outage.low, outage.high) == pytest.approx((0.0003, 0.03), rel=1e-12)
    assert outage.margin_low_db < under.margin_db < outage.margin_high_db
    assert outage.source.startswith("mission file, line")
    for key, place, item in (
        ("jitter.bias.1", "bias_rad", 0),
        ("jitter.rms.1", "rms_rad", 0),
        ("jitter.rms.2", "rms_rad", 1),
    ):
        each = found[key]
        assert (each.low, each.high) == pytest.approx((0.9 * each.value, 1.1 * each.value), rel=1e-12)
        assert each.unit == "rad"
        for value, margin in ((each.low, each.margin_low_db), (each.high, each.margin_high_db)):
            both = list(getattr(m.jitter, place))
            both[item] = value
            moved = changed(m, f"jitter.{place}", tuple(both))
            found_db = link_performance.performance_under_jitter(link.of(moved)).margin_db
            assert found_db == pytest.approx(margin, abs=1e-9)
        assert each.margin_low_db > under.margin_db > each.margin_high_db


def test_the_margin_under_a_jitter_of_equal_axes_is_at_a_quantile_of_rayleigh(tmp_path):
    equal = {"jitter": {"bias": ["0 urad", "0 urad"], "rms": ["3 urad", "3 urad"], "bandwidth": "50 Hz"}}
    m = link_file(tmp_path, equal).mission
    loss = 8.685889638 * (3e-6 / HALF) ** 2 * 2 * math.log(1 / 0.003)
    on_axis = budgets.communication(m, {}, pointing_error_rad=0.0).margin_db
    assert link_performance.margin_db(link.of(m)) == pytest.approx(on_axis - loss, abs=1e-8)
    plain = link_file(tmp_path).mission
    assert link_performance.margin_db(link.of(plain)) == pytest.approx(
        budgets.communication(plain, {}).margin_db, abs=1e-9
    )


@pytest.mark.promise("link-10")
def test_a_study_holds_a_tornado_for_each_margin_that_there_is(tmp_path):
    file = link_file(tmp_path, {"acquisition": None}, JITTER)
    m, sources = file.mission, file.sources
    communication = link_study.communication_budget(link.of(m), sources)
    all_three = communication, budgets.beacon(m, sources), budgets.answer(m, sources)
    found = link_study.tornados(m, sources, all_three)
    assert [each.of for each in found] == ["Communication", "Beacon", "Answer"]
    assert [each.margin_db for each in found] == [each.margin_db for each in all_three]
    assert found[1].swings == variation.beam_tornado(m, file.sources, "beacon")
    assert found[2].swings == variation.beam_tornado(m, file.sources, "answer")


@pytest.mark.parametrize("name", RECEIVERS)
def test_a_receivers_values_are_among_the_inputs(tmp_path, name):
    found = {key.removeprefix("communication.receiver.") for key in swings(tmp_path, received_with(name))}
    plain = set(RECEIVERS[name]) - {"modulation", "detector", "order", "bandwidth", "polarisations"}
    without_code = "psk" in name  # linear in the rate: the code's rate changes nothing
    plain -= {"code_rate"} if without_code else set()
    missing = plain - found
    assert missing <= {"code_rate", "dark_count_rate", "dark_current"}, missing
    assert "communication.receiver_sensitivity" not in found


def test_a_background_of_the_sky_is_among_the_inputs(tmp_path):
    found = swings(tmp_path, *CASES["sky"])
    prefix = "communication.receiver.background."
    assert {f"{prefix}{key}" for key in SKY} <= found.keys()
    assert found[f"{prefix}field_of_view"].swing_db > found[f"{prefix}filter_bandwidth"].swing_db


# ---- bounds
@pytest.mark.promise("link-10")
def test_a_value_at_its_bound_moves_to_the_other_side_only(tmp_path):
    at_bounds = swings(
        tmp_path,
        {"communication.strehl": 0.0, "communication.transmit_optics_loss": "0.2 dB"},
        received_with("apd ook", efficiency=1.0, code_rate=1.0, ionisation_ratio=0.95, avalanche_gain=1.05),
    )
    receiver = "communication.receiver."
    for key, low, high in (
        ("communication.strehl", 0.0, STEP_DB),
        ("communication.transmit_optics_loss", 0.0, 0.2 + STEP_DB),
        ("communication.tracking_split_loss", 0.0, STEP_DB),
        (f"{receiver}efficiency", 0.9, 1.0),
        (f"{receiver}ionisation_ratio", 0.855, 1.0),
        (f"{receiver}avalanche_gain", 1.0, 1.155),
    ):
        assert (at_bounds[key].low, at_bounds[key].high) == pytest.approx((low, high), abs=1e-12), key


@pytest.mark.parametrize(("strehl", "low", "high"), [(0.4, 0.36, 0.44), (0.95, 0.855, 1.0), (1.0, 0.9, 1.0)])
def test_a_strehl_ratio_moves_by_a_share_of_itself_and_not_beyond_one(tmp_path, strehl, low, high):
    moved = swings(tmp_path, {"conventions.strehl": "ratio", "communication.strehl": strehl})["communication.strehl"]
    assert (moved.low, moved.high) == pytest.approx((low, high), abs=1e-12)
    assert moved.swing_db == pytest.approx(10 * math.log10(high / low), abs=1e-9)


@pytest.mark.promise("link-10")
@pytest.mark.parametrize(("ratio", "low", "high"), [(1e-6, 1e-7, 1e-5), (1e-18, 1e-18, 1e-17), (0.1, 0.01, 0.3)])
def test_a_bit_error_ratio_moves_by_a_factor_of_ten(tmp_path, ratio, low, high):
    found = swings(tmp_path, received_with("preamplified dpsk", bit_error_ratio=ratio))
    moved = found["communication.receiver.bit_error_ratio"]
    assert (moved.low, moved.high) == pytest.approx((low, high), rel=1e-12, abs=0.0)
    assert moved.swing_db == pytest.approx(10 * math.log10(math.log(0.5 / low) / math.log(0.5 / high)), abs=1e-9)


@pytest.mark.promise("link-10")
def test_an_extinction_ratio_stays_above_none(tmp_path):
    found = swings(tmp_path, received_with("pin ook", extinction_ratio="0.3 dB"))
    moved = found["communication.receiver.extinction_ratio"]
    assert (moved.low, moved.high) == pytest.approx((0.15, 0.8), abs=1e-12)
    assert math.isfinite(moved.swing_db)


def test_an_amplifier_and_an_elevation_stay_within_their_bounds(tmp_path):
    found = swings(
        tmp_path,
        {"channel": {"zenith_transmission": 0.95, "elevation": "10.5 deg"}},
        received_with("preamplified ook", noise_figure="3.1 dB", amplifier_gain="10 dB"),
    )
    assert found["communication.receiver.noise_figure"].low == 3.0
    assert "communication.receiver.amplifier_gain" not in found or (
        found["communication.receiver.amplifier_gain"].low == 10.0
    )
    assert found["channel.elevation"].low == pytest.approx(math.radians(10.0), rel=1e-12)
    assert found["channel.zenith_transmission"].high == 1.0


def test_a_receiver_too_slow_for_the_rate_has_no_margin(tmp_path):
    # 300 Mbit/s at a code rate of 0.8 are 375 MHz of symbols
    found = swings(tmp_path, received_with("homodyne bpsk", bandwidth="380 MHz"))
    for key, side in (("communication.data_rate", "high"), ("communication.receiver.bandwidth", "low")):
        assert getattr(found[key], f"margin_{side}_db") == -math.inf
        assert found[key].swing_db == math.inf
    first = list(found)[:3]
    assert set(first) == {
        "communication.data_rate",
        "communication.receiver.bandwidth",
        "communication.receiver.code_rate",
    }


def test_only_a_receiver_too_slow_is_left_without_a_margin(tmp_path):
    def refused(mission):
        raise ValueError("a value without meaning")

    file = link_file(tmp_path)
    with pytest.raises(ValueError, match="a value without meaning"):
        link.swings(file.mission, file.sources, link.LINK_TABLES, "decibel", refused, link.beam_passes)


def test_a_beam_moves_no_further_than_the_obscuration_lets_some_of_it_pass(tmp_path):
    thin = {"communication.beam": {**GAUSSIAN, "radius": "9 mm"}, "terminals.leo_obscuration": 0.5}
    found = swings(tmp_path, PATTERN, thin)
    for key, side in (("communication.beam.radius", "low"), ("terminals.leo_obscuration", "high")):
        each = found[key]
        assert each.low < each.value < each.high
        assert abs(getattr(each, side) - each.value) < RELATIVE * each.value * (1 - 1e-9)
        assert all(math.isfinite(margin) for margin in margins(each))
    assert all(math.isfinite(margin) for each in found.values() for margin in margins(each))


# ---- what is said about an input
def test_units_and_kinds_of_source_travel_along():
    file = load_link(SHIPPED)
    found = {each.key: each for each in of_communication(file).swings}
    assert found["communication.transmit_power"].kind == "paper"
    assert found["communication.receiver_sensitivity"].kind == "derived"
    assert found["communication.distance"].unit == "m"
    assert found["communication.distance"].value == 42e6
    assert found["communication.strehl"].unit == "dB"  # read as a loss
    assert found["communication.transmit_optics_loss"].unit == "dB"
    assert found["communication.transmit_power"].source == "paper: Table 2"
    without = of_communication(replace(file, sources={})).swings
    assert {each.kind for each in without} == {""}
    assert {each.source for each in without} == {"not stated"}


def test_every_quantity_of_the_links_tables_is_tried(tmp_path):
    # a key whose rule stands in a union or apart would be left out without a word
    file = link_file(tmp_path, PATTERN, CHANNEL, LEFT, received_with("apd ook", background=SKY, background_power=None))
    beam = file.mission.communication
    for table in (
        file.mission.terminals,
        beam,
        beam.receiver,
        beam.receiver.background,
        beam.beam,
        file.mission.channel,
    ):
        for name, info in type(table).model_fields.items():
            if isinstance(getattr(table, name), float):
                inner = [
                    rule
                    for arg in getattr(info.annotation, "__args__", ())
                    for rule in getattr(arg, "__metadata__", ())
                ]
                assert any(isinstance(rule, Quantity) for rule in (*info.metadata, *inner)), name
    assert GAUSSIAN["m_squared"] > 1.0


@pytest.mark.promise("link-92")
def test_a_phase_error_and_its_ratio_move_no_further_than_some_power_reaches(tmp_path):
    found = swings(tmp_path, received_with("heterodyne qpsk", phase_error="0.155 rad"))  # 0.1652 rad at the most
    for key in ("phase_error", "bit_error_ratio"):
        moved = found[f"communication.receiver.{key}"]
        assert math.isfinite(moved.swing_db)
        assert moved.swing_db > 1.0
        assert (0.155 if key == "phase_error" else 1e-6) == moved.value
        assert moved.high < 0.1652 if key == "phase_error" else 1e-7 < moved.low < 1e-6


@pytest.mark.parametrize(
    ("field", "value", "rule", "strehl", "ends"),
    [
        ("loss_db", 0.5, Quantity("dB", least=0.0), "ratio", (0.0, 1.0)),
        ("loss_db", 0.2, Quantity("dB", least=0.0), "ratio", (0.0, 0.7)),
        ("ratio_db", 0.5, Quantity("dB", above=0.0), "ratio", (0.25, 1.0)),
        ("ratio_db", 0.6, Quantity("dB", above=0.0), "ratio", (0.1, 1.1)),
        ("strehl", 0.9, Quantity(""), "ratio", (0.81, 0.99)),
        ("strehl", 0.95, Quantity(""), "ratio", (0.855, 1.0)),
        ("strehl", -1.0, Quantity(""), "decibel", (-1.5, -0.5)),
        ("outage", 0.1, Share(""), "ratio", (0.01, 0.55)),
        ("outage", 0.01, Share(""), "ratio", (0.001, 0.1)),
        ("bit_error_ratio", 0.2, Share("", below=0.5), "ratio", (0.02, 0.35)),
        ("share", 0.8, Share(""), "ratio", (0.72, 0.88)),
        ("share", 0.95, Share(""), "ratio", (0.855, 0.975)),
        ("angle", -2.0, Quantity("rad"), "ratio", (-2.2, -1.8)),
        ("angle", 3.0, Quantity("rad", most=3.1), "ratio", (2.7, 3.1)),
    ],
)
def test_a_swing_goes_a_tenth_or_half_a_decibel_to_either_side_and_half_way_to_an_open_bound(
    field, value, rule, strehl, ends
):
    assert variation._ends(field, value, rule, strehl) == pytest.approx(ends, abs=1e-12)


@pytest.mark.parametrize(("found", "expected"), [
    (lambda: variation._ends("transmit_power_w", 4.6, Quantity("W", above=0.0), "decibel"), [4.14, 5.06]),
    (lambda: variation._ends("margin_db", 0.3, Quantity("dB", least=0.0), "decibel"), [0.0, 0.8]),
    (lambda: variation._ends("strehl", 0.97, Quantity("", above=0.0), "ratio"), [0.873, 1.0]),
    (lambda: variation._ends("strehl", 0.3, Quantity("", least=0.0), "decibel"), [0.0, 0.8]),
    (lambda: variation._ends("outage", 0.02, Share(""), "ratio"), [0.002, 0.2]),
    (lambda: variation._ends("outage", 0.3, Share(""), "ratio"), [0.03, 0.65]),
    (lambda: variation._ends("bit_error_ratio", 3e-18, Share("", least=1e-18, below=0.5), "ratio"),
     [1e-18, 3e-17]),
    (lambda: variation._ends("bias_rad", -2e-6, Quantity("rad"), "ratio"), [-2.2e-06, -1.8e-06]),
    (lambda: variation._ends("efficiency", 0.96, Quantity("", above=0.0, most=1.0), "ratio"), [0.864, 1.0]),
])  # fmt: skip
def test_an_input_is_moved_within_its_bounds(found, expected):
    assert list(found()) == pytest.approx(expected, rel=1e-6, abs=0.0, nan_ok=True)


@pytest.mark.parametrize(("found", "expected"), [
    (lambda: variation._ends("loss_db", 0.25, Quantity("dB", least=0.0), "ratio"), "0 0.75"),
    (lambda: variation._ends("strehl", 0.96, Quantity(""), "ratio"), "0.864 1"),
    (lambda: variation._ends("strehl", 0.96, Quantity("dB", least=0.0), "decibel"), "0.46 1.46"),
    (lambda: variation._ends("outage", 0.2, Share(""), "ratio"), "0.02 0.6"),
    (lambda: variation._ends("bit_error_ratio", 1e-18, Share("", least=1e-18, below=0.5), "ratio"), "1e-18 1e-17"),
    (lambda: variation._ends("height_m", -400.0, Quantity("m", least=-430.0, most=9000.0), "ratio"), "-430 -360"),
    (lambda: variation._ends("rate", 4.0, Quantity("", above=3.9, most=4.1), "ratio"), "3.95 4.1"),
    (lambda: [variation._farthest(5, lambda step: step <= 3.25), variation._farthest(-5, lambda step: step >= -9.0),
            variation._farthest(4, lambda step: step <= 0.0)],
     "3.25 -5 0"),
    (lambda: [variation._edge(1.0, 2.0, lambda step: step <= 1.375)], "1.375"),
    (lambda: [variation.margin_or_none(3.0, lambda of: 2.0 * of), variation.Swing("", "", 0, 0, 0, 1.5, -2.25, "",
            "").swing_db],
     "6 3.75"),
])  # fmt: skip
def test_inputs_at_their_edges_move_within_these_bounds(found, expected):
    assert list(found()) == pytest.approx([float(each) for each in expected.split()], rel=1e-6, abs=0.0, nan_ok=True)


def test_each_axis_of_a_jitter_has_the_source_of_its_key_and_its_place_behind_it(tmp_path):
    file = link_file(tmp_path, JITTER, NO_BEAMS)
    told = {"bias": "datasheet: Table 1", "rms": "assumption: as on the ground"}
    sources = file.sources | {
        f"jitter.{key}": replace(file.sources[f"jitter.{key}"], comment=text) for key, text in told.items()
    }
    found = link.swings(
        file.mission, sources, ("jitter",), "ratio", lambda m: 1e6 * sum(m.jitter.rms_rad + m.jitter.bias_rad), bool
    )
    assert [(each.key, each.source) for each in found] == [
        ("jitter.rms.1", told["rms"]),
        ("jitter.rms.2", told["rms"]),
        ("jitter.bias.1", told["bias"]),
    ]
    assert [each.kind for each in found] == [sources[each.key[:-2]].kind for each in found]
    assert found[0].kind == "assumption"
    assert [each.swing_db for each in found] == pytest.approx([0.6, 0.4, 0.2], rel=1e-9)
