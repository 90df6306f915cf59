"""The link budget against the paper's table, against numbers computed elsewhere, and against itself turned round."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import quad
from scipy.special import erfc

import budgets
from link_files import link_file
from microrad import link
from microrad.core.budget import total_db
from microrad.core.units import format_quantity
from microrad.link import gains, requirement
from microrad.link import study as link_study
from microrad.mission.file import load_mission
from microrad.mission.model import Source
from microrad.mission.tables.channel import Channel
from microrad.report.links import words as links_words
from places import ROOT

FILE = load_mission(ROOT / "missions" / "paper.toml")
MISSION, SOURCES = FILE.mission, FILE.sources
BUDGETS = [budgets.communication, budgets.beacon, budgets.answer]
half_a_hundredth_db = 0.005


def changed(**tables):
    """The mission with some values of some tables changed: changed(communication={"strehl": 0.5})."""
    return MISSION.model_copy(
        update={name: getattr(MISSION, name).model_copy(update=values) for name, values in tables.items()}
    )


def value_of(budget, name):
    return next(line.value for line in (*budget.lines, *budget.totals) if line.name == name)


# ---- numbers from outside: arithmetic from the paper's Table 2, computed twice by independent means
@pytest.mark.parametrize(
    ("computed", "printed"),
    [
        (gains.aperture_gain_db(0.05, 1.55e-6), 100.12),
        (gains.aperture_gain_db(0.15, 1.55e-6), 109.66),
        (gains.free_space_loss_db(42e6, 1.55e-6), 290.64),
        (gains.free_space_loss_db(44e6, 1.55e-6), 291.05),
        (gains.pointing_loss_db(10e-6, 0.05, 1.55e-6, "gaussian"), 2.23),
        (gains.pointing_loss_db(10e-6, 0.05, 1.55e-6, "gain"), 4.46),
        (gains.strehl_loss_db(0.4, "ratio"), 3.98),
        (gains.strehl_loss_db(0.4, "decibel"), 0.40),
    ],
)
def test_terms_of_the_papers_table(computed, printed):
    assert computed == pytest.approx(printed, abs=half_a_hundredth_db)


def test_five_watts_without_losses():
    lossless = changed(communication={"strehl": 0.0, "pointing_error_rad": 0.0})
    received = value_of(budgets.communication(lossless, SOURCES), "Received power")
    assert received == pytest.approx(-43.88, abs=half_a_hundredth_db)  # 5 W, 5 cm, 15 cm, 42 000 km


@pytest.mark.promise("link-12")
def test_the_papers_margin_is_reproduced():
    budget = budgets.communication(MISSION, SOURCES)
    # paper, section 2.2: 3 dB at 300 Mbit/s and 10 µrad, from which the sensitivity was inferred
    assert budget.margin_db == pytest.approx(3.0, abs=0.02)
    assert budgets.beacon(MISSION, SOURCES).margin_db > 0.0  # Table 2 prints "+"


@pytest.mark.parametrize(
    ("divergence", "at_error", "on_axis"), [("full-1/e2", 2.42e-9, 8.65e-9), ("half-1/e2", 1.47e-9, 8.65e-9 / 4)]
)
def test_beacon_irradiance_at_geo(divergence, at_error, on_axis):
    # 4 W, 780 µrad, 44 000 km, 300 µrad off axis, Strehl 0.4 dB: nW/m² by 2 P / (pi w²) exp(-2 r² / w²)
    budget = budgets.beacon(changed(conventions={"divergence": divergence}), SOURCES)
    assert budget.irradiance_w_m2 == pytest.approx(at_error, abs=0.005e-9)
    assert budget.irradiance_on_axis_w_m2 == pytest.approx(on_axis, abs=0.005e-9)


def test_a_gaussian_beam_carries_all_its_power():
    half = 390e-6
    gain = 10 ** (gains.gaussian_beam_gain_db(half) / 10) / (4 * math.pi)

    def ring(angle):
        return 2 * math.pi * angle * gain * 10 ** (-float(gains.gaussian_pointing_loss_db(angle, half)) / 10)

    assert quad(ring, 0.0, 10 * half)[0] == pytest.approx(1.0, rel=1e-6)


def test_gaussian_pointing_loss_is_8_686_times_the_squared_ratio():
    half = 2 * 1.55e-6 / (math.pi * 0.05)  # lambda / (pi w0), w0 = D / 2
    assert gains.pointing_loss_db(half, 0.05, 1.55e-6, "gaussian") == pytest.approx(8.686, abs=0.0005)
    assert gains.gaussian_pointing_loss_db(half, half) == pytest.approx(8.686, abs=0.0005)


def test_the_four_readings_of_the_paper_imply_76_to_291_photons_per_bit():
    readings = {(r.pointing_loss, r.strehl): r.photons_per_bit for r in link.implied_sensitivity(link.of(MISSION))}
    assert len(readings) == 4
    assert min(readings.values()) == readings["gain", "ratio"] == pytest.approx(76, abs=0.5)
    assert max(readings.values()) == readings["gaussian", "decibel"] == pytest.approx(291, abs=0.5)


@pytest.mark.parametrize("pointing_loss", ["gaussian", "gain"])
@pytest.mark.parametrize("strehl", ["decibel", "ratio"])
def test_an_implied_sensitivity_gives_back_the_required_margin(pointing_loss, strehl):
    readings = {(r.pointing_loss, r.strehl): r.photons_per_bit for r in link.implied_sensitivity(link.of(MISSION))}
    mission = changed(
        conventions={"pointing_loss": pointing_loss, "strehl": strehl},
        communication={"receiver_sensitivity_photon_bit": readings[pointing_loss, strehl]},
    )
    error = MISSION.requirement.pointing_error_rad
    assert budgets.communication(mission, SOURCES, error).margin_db == pytest.approx(3.0, abs=1e-9)


@pytest.mark.parametrize(("strehl", "count"), [(0.0, 2), (1.5, 2), (1.0, 4)])
def test_a_strehl_that_is_no_ratio_is_not_read_as_one(strehl, count):
    assert len(link.implied_sensitivity(link.of(changed(communication={"strehl": strehl})))) == count


BIT_ERROR_RATIOS = {
    "Homodyne BPSK": (8.99, lambda n: erfc(math.sqrt(2 * n)) / 2),
    "Preamplified DPSK": (20.03, lambda n: math.exp(-n) / 2),
    "On-off keying, photon counting": (10.0, lambda n: math.exp(-2 * n) / 2),
}


def test_ideal_receivers_at_one_error_in_a_thousand_million():
    receivers = link.ideal_receivers(link.of(MISSION), SOURCES)
    assert [r.name for r in receivers] == list(BIT_ERROR_RATIOS)
    for receiver in receivers:
        printed, error_ratio = BIT_ERROR_RATIOS[receiver.name]
        assert receiver.photons_per_bit == pytest.approx(printed, abs=0.005 if printed != 10.0 else 0.05)
        assert error_ratio(receiver.photons_per_bit) == pytest.approx(1e-9, rel=1e-6)
        beam = changed(communication={"receiver_sensitivity_photon_bit": receiver.photons_per_bit})
        assert receiver.margin_db == pytest.approx(budgets.communication(beam, SOURCES).margin_db, abs=1e-9)


def test_ideal_receivers_follow_the_pointing_error_given():
    near, far = (
        link.ideal_receivers(link.of(MISSION), SOURCES, 0.0)[0],
        link.ideal_receivers(link.of(MISSION), SOURCES, 20e-6)[0],
    )
    assert near.margin_db - far.margin_db == pytest.approx(4 * 2.23, abs=0.02)
    assert far.source.endswith("chosen for this evaluation")


@pytest.mark.parametrize("budget_of", BUDGETS)
def test_the_radiant_intensity_is_what_the_path_thins_out(budget_of):
    budget = budget_of(MISSION, SOURCES)
    beam = getattr(MISSION, budget.name.lower())
    there = budget.radiant_intensity_w_sr / beam.distance_m**2
    assert budget.irradiance_w_m2 == pytest.approx(there * 10 ** (value_of(budget, "Pointing loss") / 10), rel=1e-9)
    assert value_of(budget, "Strehl loss") < 0.0  # counted in both


@pytest.mark.parametrize("budget_of", BUDGETS)
def test_the_radiant_intensity_is_that_before_the_air(budget_of):
    sky = Channel.model_validate({"zenith_transmission": 0.5, "elevation": "30 deg"})
    clear, hazy = (budget_of(MISSION.model_copy(update={"channel": c}), SOURCES) for c in (None, sky))
    assert hazy.irradiance_w_m2 < 0.6 * clear.irradiance_w_m2
    assert hazy.radiant_intensity_w_sr == pytest.approx(clear.radiant_intensity_w_sr, rel=1e-12)


# ---- the shape of a budget
@pytest.mark.promise("decisions-1", "readme-7")
@pytest.mark.parametrize("budget_of", BUDGETS)
def test_a_budget_is_the_sum_of_its_lines(budget_of):
    budget = budget_of(MISSION, SOURCES)
    received = value_of(budget, "Received power")
    assert total_db(budget.lines) == received
    assert 10 * math.log10(budget.received_power_w * 1e3) == pytest.approx(received, abs=1e-9)
    assert budget.margin_db == pytest.approx(received - value_of(budget, "Required power"), abs=1e-12)
    assert budget.margin_db == pytest.approx(
        10 * math.log10(budget.received_power_w / budget.required_power_w), abs=1e-9
    )
    for line in (*budget.lines, *budget.totals):
        assert line.basis
        assert line.source
        assert line.regime
        assert "not stated" not in line.source


@pytest.mark.parametrize("budget_of", BUDGETS)
def test_irradiance_times_area_is_the_received_power(budget_of):
    budget = budget_of(MISSION, SOURCES)
    aperture = MISSION.terminals.leo_aperture_m if budget.name == "Answer" else MISSION.terminals.geo_aperture_m
    assert budget.irradiance_w_m2 * math.pi * aperture**2 / 4 == pytest.approx(
        budget.received_power_w, rel=1e-9, abs=0.0
    )
    assert budget.irradiance_on_axis_w_m2 > budget.irradiance_w_m2


@pytest.mark.promise("link-7")
def test_photons_received_for_each_bit_stand_in_the_budget():
    budget, beam = budgets.communication(MISSION, SOURCES, data_rate_bit_s=1e9), MISSION.communication
    photons = budget.received_power_w * beam.wavelength_m / (6.62607015e-34 * 299_792_458.0) / 1e9
    assert budget.received_photons_per_bit == pytest.approx(photons, rel=1e-12)
    assert budget.totals[0].basis == f"sum of the lines above: {photons:.4g} photon/bit"
    assert budgets.beacon(MISSION, SOURCES).received_photons_per_bit is None


def test_more_light_received_than_sent_is_no_margin(tmp_path):
    near = link_file(tmp_path, {"communication.distance": "1 m"})
    study = link_study.run_link_study(near)
    assert study.communication.margin_db > 100.0
    assert not study.communication.possible and not study.closes
    (row,) = [r for r in requirement.of_links(study) if r.subject == "communication"]
    assert (row.met, row.mark, row.because) == (False, "FAIL", requirement.IMPOSSIBLE)
    assert "The links do not close" in links_words.verdict(study)
    assert link_study.run_link_study(link_file(tmp_path)).communication.possible


@pytest.mark.promise("decisions-1")
@pytest.mark.promise("link-9")
def test_a_term_at_zero_decibel_is_a_line():
    zero = [line for line in budgets.communication(MISSION, SOURCES).lines if line.value == 0.0]
    names = {"Transmit optics loss", "Receive optics loss", "Tracking split loss", "Implementation loss"}
    assert {line.name for line in zero} == names | {"Point-ahead loss"}
    assert set(budgets.communication(MISSION, SOURCES).at_zero) == names
    assert all(math.copysign(1.0, line.value) == 1.0 for line in zero)  # no "-0 dB" in a report


@pytest.mark.parametrize(
    "loss", ["transmit_optics_loss_db", "receive_optics_loss_db", "tracking_split_loss_db", "implementation_loss_db"]
)
def test_every_loss_lowers_margin_map_rate_and_sensitivity(loss):
    lossy = changed(communication={loss: 2.5})
    assert budgets.communication(lossy, SOURCES).margin_db == pytest.approx(
        budgets.communication(MISSION, SOURCES).margin_db - 2.5, abs=1e-9
    )
    assert link.margin_map(link.of(lossy), 3e8, 1e-5) == pytest.approx(
        link.margin_map(link.of(MISSION), 3e8, 1e-5) - 2.5, abs=1e-9
    )


def test_a_beam_takes_its_losses_too():
    lossy = changed(beacon={"transmit_optics_loss_db": 1.0, "receive_optics_loss_db": 2.0, "strehl": 1.4})
    before, after = budgets.beacon(MISSION, SOURCES), budgets.beacon(lossy, SOURCES)
    assert after.margin_db == pytest.approx(before.margin_db - 4.0, abs=1e-9)
    assert after.irradiance_w_m2 == pytest.approx(before.irradiance_w_m2 * 10**-0.2, rel=1e-9)
    assert after.irradiance_on_axis_w_m2 == pytest.approx(before.irradiance_on_axis_w_m2 * 10**-0.1, rel=1e-9)


@pytest.mark.promise("readme-7")
def test_sources_travel_into_the_lines():
    lines = {line.name: line for line in budgets.communication(MISSION, SOURCES, data_rate_bit_s=1e8).lines}
    assert lines["Transmit power"].source == "paper: Table 2"
    assert lines["Receive optics loss"].source.startswith("assumption:")
    assert budgets.communication(MISSION, {}).lines[0].source == "not stated"
    chosen = budgets.communication(MISSION, SOURCES, 1e-6)
    assert next(line for line in chosen.lines if line.name == "Pointing loss").source == "chosen for this evaluation"


# ---- the map and the solved limits against the budget
def test_the_map_is_the_budget_at_every_point():
    rates, errors = np.geomspace(1e6, 1e10, 5), np.linspace(0.0, 40e-6, 4)
    margins = link.margin_map(link.of(MISSION), rates, errors)
    assert margins.shape == (5, 4)
    for i, rate in enumerate(rates):
        for j, error in enumerate(errors):
            budget = budgets.communication(MISSION, SOURCES, error, rate)
            assert margins[i, j] == pytest.approx(budget.margin_db, abs=1e-9)


def test_margin_of_error_is_the_map_at_the_missions_rate():
    errors = np.linspace(0.0, 30e-6, 6).reshape(2, 3)
    margins = link.margin_of_error(link.of(MISSION), errors)
    assert margins.shape == (2, 3)
    np.testing.assert_allclose(
        margins.ravel(), link.margin_map(link.of(MISSION), 300e6, errors.ravel())[0], rtol=0, atol=1e-12
    )
    assert float(link.margin_of_error(link.of(MISSION), 10e-6)) == pytest.approx(
        budgets.communication(MISSION, SOURCES).margin_db, abs=1e-9
    )


@settings(deadline=None)  # the machine may be busy
@given(
    st.floats(0.0, 20.0),
    st.floats(0.0, 20e-6),
    st.sampled_from(["gaussian", "gain"]),
    st.sampled_from(["decibel", "ratio"]),
)
def test_the_largest_data_rate_leaves_the_margin_asked_for(margin, error, pointing_loss, strehl):
    mission = changed(conventions={"pointing_loss": pointing_loss, "strehl": strehl})
    rate = link.largest_data_rate(link.of(mission), margin, error)
    assert budgets.communication(mission, SOURCES, error, rate).margin_db == pytest.approx(margin, abs=1e-9)


def test_a_link_without_a_bit_a_second_has_no_largest_data_rate():
    with pytest.raises(link.LinkError, match=r"not even 1 bit/s leaves a margin of 3 dB: 114.27 dB are missing"):
        link.largest_data_rate(link.of(MISSION), 3.0, 95e-6)


@settings(deadline=None)  # the machine may be busy
@given(st.floats(0.0, 20.0), st.floats(1e3, 5e6), st.sampled_from(["gaussian", "gain"]))
def test_the_largest_pointing_error_leaves_the_margin_asked_for(margin, rate, pointing_loss):
    mission = changed(conventions={"pointing_loss": pointing_loss})
    error = link.largest_pointing_error(link.of(mission), margin, rate)
    assert error > 0.0
    assert budgets.communication(mission, SOURCES, error, rate).margin_db == pytest.approx(margin, abs=1e-9)
    assert budgets.communication(mission, SOURCES, error * 1.01, rate).margin_db < margin


def test_a_link_that_cannot_close_on_axis_says_by_how_much():
    with pytest.raises(link.LinkError, match="at 30 Gbit/s a margin of 3 dB is missed by") as refused:
        link.largest_pointing_error(link.of(MISSION), 3.0, 30e9)
    missing = 3.0 - float(link.margin_map(link.of(MISSION), 30e9, 0.0)[0, 0])
    assert f"missed by {missing:.2f} dB" in str(refused.value)
    rate = link.largest_data_rate(link.of(MISSION), 3.0, 0.0)
    assert f"up to {rate / 1e6:.1f} Mbit/s" in str(refused.value)
    assert link.largest_pointing_error(link.of(MISSION), 3.0, rate * (1 - 1e-12)) == pytest.approx(0.0, abs=1e-9)


@settings(deadline=None)  # the machine may be busy
@given(st.floats(1e5, 1e11), st.floats(0.0, 1e-4), st.floats(1.01, 10.0))
def test_more_rate_more_error_or_more_distance_never_help(rate, error, factor):
    here = budgets.communication(MISSION, SOURCES, error, rate).margin_db
    faster = budgets.communication(MISSION, SOURCES, error, rate * factor).margin_db
    assert faster == pytest.approx(here - 10 * math.log10(factor), abs=1e-9)
    assert budgets.communication(MISSION, SOURCES, error * factor, rate).margin_db <= here
    further = changed(communication={"distance_m": MISSION.communication.distance_m * factor})
    expected = here - 20 * math.log10(factor)
    assert budgets.communication(further, SOURCES, error, rate).margin_db == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize(
    ("rate", "error", "what"),
    [(0.0, 1e-5, "data rate is 0"), (1e8, -1e-6, "pointing error is -1"), (math.nan, 0.0, "data")],
)
def test_impossible_points_are_refused(rate, error, what):
    with pytest.raises(ValueError, match=what):
        link.margin_map(link.of(MISSION), [rate], [error])
    with pytest.raises(ValueError, match=what):
        budgets.communication(MISSION, SOURCES, error, rate)


@pytest.mark.promise("decisions-1")
def test_an_unknown_convention_is_named():
    with pytest.raises(ValueError, match='"top-hat" is neither "gaussian" nor "gain"'):
        gains.pointing_loss_db(1e-6, 0.05, 1.55e-6, "top-hat")
    with pytest.raises(ValueError, match='"linear" is neither'):
        gains.strehl_loss_db(0.4, "linear")


@pytest.mark.parametrize(
    ("each", "all_of_them"), [((True, True), True), ((True, False), False), ((False, False), False), ((), True)]
)
def test_links_are_met_where_each_requirement_is(monkeypatch, each, all_of_them):
    monkeypatch.setattr(requirement, "of_links", lambda study: [SimpleNamespace(met=met) for met in each])
    assert requirement.met("the study") is all_of_them


@pytest.mark.parametrize(("leo_m", "geo_m"), [(0.2, 0.15), (0.15, 0.2)])
@pytest.mark.parametrize("name", ["communication", "beacon", "answer"])
def test_the_far_field_begins_where_that_of_the_larger_aperture_does(name, leo_m, geo_m):
    begins_m = 2.0 * 0.2**2 / getattr(MISSION, name).wavelength_m
    for share, near in ((0.999, True), (1.0, False)):
        apertures = {"leo_aperture_m": leo_m, "geo_aperture_m": geo_m}
        mission = changed(terminals=apertures, **{name: {"distance_m": share * begins_m}})
        (space,) = (line for line in getattr(budgets, name)(mission, SOURCES).lines if line.name == "Free-space loss")
        assert space.warning.startswith("nearer than the far field, which begins at ") is near
        assert not near or space.warning.endswith(f" {begins_m / 1e3:.4g} km")


def test_ideal_receivers_have_their_formulas_and_say_where_rate_and_error_come_from():
    sources = {"communication.data_rate": Source(7, "paper: 2.2"), "communication.pointing_error": Source(9, "")}
    for error_rad, said in ((None, "mission file, line 9"), (0.0, "chosen for this evaluation")):
        found = link.ideal_receivers(link.of(MISSION), sources, error_rad)
        assert [(each.formula, each.source) for each in found] == [
            ("BER = erfc(sqrt(2 n)) / 2", f"paper: 2.2; {said}"),
            ("BER = exp(-n) / 2", f"paper: 2.2; {said}"),
            ("BER = exp(-2 n) / 2, n averaged over marks and spaces", f"paper: 2.2; {said}"),
        ]


@pytest.mark.parametrize(("margin_db", "instead"), [
    (20.0, "up to {rate} it would be there, or with that much more power or gain"),
    (200.0, "it would be there with that much more power or gain"),
])  # fmt: skip
def test_a_margin_that_is_missed_on_the_axis_is_told_with_the_rate_that_has_it(margin_db, instead):
    data = link.of(MISSION)
    missed = margin_db - float(link.margin_map(data, 300e6, 0.0)[0, 0])
    rate = format_quantity(300e6 * 10.0 ** (-missed / 10.0), "bit/s")
    with pytest.raises(link.LinkError) as refused:
        link.largest_pointing_error(data, margin_db, 300e6)
    assert str(refused.value) == (
        f"at 300 Mbit/s a margin of {margin_db:g} dB is missed by {missed:.2f} dB even without pointing error; "
        + instead.format(rate=rate)
    )
