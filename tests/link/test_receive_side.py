"""The receiver's fibre, detector and pointing in budgets, under jitter and in campaigns; what is refused."""

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.optimize import brentq

from link_files import link_file, received_with
from microrad import link
from microrad.campaign.rows.evaluate import _exposure
from microrad.link import coupling
from microrad.link import study as link_study
from microrad.link.acquisition.partner_search import _return_reach
from microrad.link.beams import GaussianFall
from microrad.link.budget.lines import _coupling_lines, _few_modes
from microrad.link.pointing import outage as link_performance
from microrad.link.pointing.code_words import FadeMargin
from microrad.link.pointing.coded_residual import CodedBeam
from microrad.link.pointing.fading import level_crossing_rate_hz
from microrad.link.pointing.outage import ErrorDistribution, Exposure, GaussianErrors
from microrad.link.radial_error import Jitter
from microrad.loop.pointing_loop.ensemble import bin_edges_rad
from microrad.mission.file import MissionError
from microrad.mission.model import source_text
from microrad.study.pointing_penalty import Binned

NO_BEAMS = dict.fromkeys(("beacon", "answer", "acquisition"))
JITTER = {"jitter": {"bias": ["1 urad", "0 urad"], "rms": ["3 urad", "2 urad"], "bandwidth": "50 Hz"}}
THEIRS = {"bias": ["0 urad", "0.5 urad"], "rms": ["1 urad", "0.6 urad"], "bandwidth": "80 Hz"}
FIBRE = {"into": "single-mode fibre", "mode_radius": "best"}
MULTI = {"into": "multi-mode fibre", "core_radius": "25 um", "numerical_aperture": 0.2, "focal_length": "60 cm"}
DETECTOR = {"into": "detector", "detector_radius": "10 um", "focal_length": "1 m"}


@pytest.fixture(autouse=True)
def _without_tornados(monkeypatch):
    """Nothing here looks at them: they assemble each link once more for each of its inputs."""
    monkeypatch.setattr(link_study, "tornados", lambda *args: ())


def with_coupling(folder, table, *changes):
    return link_file(folder, NO_BEAMS, {"communication.coupling": table}, *changes)


def lines_of(file):
    budget = link_study.run_link_study(file).communication
    return {line.name: line for line in budget.lines}, budget


# -------------------------------------------------------------------------------------------------------- the budget
@pytest.mark.promise("readme-7", "link-71", "link-73")
@pytest.mark.parametrize("table", [FIBRE, MULTI, DETECTOR], ids=["fibre", "multi-mode", "detector"])
def test_the_budget_has_coupling_and_receive_pointing_as_lines(tmp_path, table):
    without = link_study.run_link_study(link_file(tmp_path, NO_BEAMS)).communication
    still, budget = lines_of(with_coupling(tmp_path, table))
    pointed, with_error = lines_of(with_coupling(tmp_path, table | {"pointing_error": "4 urad"}))
    data = link.of(with_coupling(tmp_path, table | {"pointing_error": "4 urad"}).mission)
    end = data.receiving.end
    assert still["Coupling loss"].value == pytest.approx(-float(end.loss_db(0.0)), abs=1e-12)
    assert budget.margin_db == pytest.approx(without.margin_db - float(end.loss_db(0.0)), abs=1e-9)
    assert still["Receive pointing loss"].value == 0.0 and "Receive pointing loss" in budget.at_zero
    assert pointed["Receive pointing loss"].value == pytest.approx(
        -float(end.loss_db(4e-6) - end.loss_db(0.0)), abs=1e-9
    )
    assert with_error.margin_db == pytest.approx(without.margin_db - float(end.loss_db(4e-6)), abs=1e-9)
    assert "Receive pointing loss" not in with_error.at_zero
    regimes = [{line.name: line.regime for line in of.lines}["GEO aperture gain"] for of in (without, budget)]
    assert "all of its light on the detector" in regimes[0] and "what takes its light stands below" in regimes[1]


@pytest.mark.promise("link-72", "link-73")
def test_each_key_of_the_table_reaches_the_light(tmp_path):
    """By the pupil and the end that the table makes."""
    focal, mode = 0.45, 5.2e-6
    bent = {"defocus": "60 nm", "astigmatism": "-50 nm", "coma": "70 nm", "spherical": "40 nm"}
    off = {"lateral_error": "0.9 um", "angular_error": "2 mrad", "focal_length": "45 cm", "mode_radius": "5.2 um"}
    hole = {"terminals.geo_obscuration": 0.3}
    made = link.of(with_coupling(tmp_path, FIBRE | bent | off, hole).mission).receiving.end
    wavefront = coupling.Aberrations(60e-9, -50e-9, 70e-9, 40e-9)
    truncation = math.pi * mode * 0.15 / (2.0 * 1.55e-6 * focal)
    shift = math.tan(2e-3) * focal / 0.075
    pupil = coupling.Pupil(0.15, 1.55e-6, 0.3, wavefront, truncation, shift)
    assert made.offset_rad == pytest.approx(0.9e-6 / focal) and made.pupil.truncation == pytest.approx(truncation)
    assert float(made.share(2e-6, -1e-6)) == pytest.approx(
        float(coupling.SingleModeFibre(pupil, 0.9e-6 / focal).share(2e-6, -1e-6)), rel=1e-9
    )
    best = link.of(with_coupling(tmp_path, FIBRE, hole).mission).receiving.end
    assert best.pupil.truncation == pytest.approx(coupling.best_truncation(0.3))
    multi = link.of(with_coupling(tmp_path, MULTI | {"numerical_aperture": 0.1}, hole).mission).receiving.end
    assert multi.pupil.stop == pytest.approx(2.0 * 0.6 * math.tan(math.asin(0.1)) / 0.15)
    assert multi.radius_rad == pytest.approx(25e-6 / 0.6)
    disk = link.of(with_coupling(tmp_path, DETECTOR | {"lateral_error": "3 um"}).mission).receiving.end
    assert (disk.radius_rad, disk.offset_rad) == (pytest.approx(10e-6), pytest.approx(3e-6))


@pytest.mark.promise("link-73")
def test_a_fibre_of_few_modes_is_flagged(tmp_path):
    few, _ = lines_of(with_coupling(tmp_path, MULTI | {"core_radius": "10 um"}))
    assert "V = 8.11, too few modes (below 20)" in few["Coupling loss"].warning
    many, _ = lines_of(with_coupling(tmp_path, MULTI))
    assert many["Coupling loss"].warning == ""


# ------------------------------------------------------------------------------------------------------- both ends
@pytest.mark.promise("link-74")
@pytest.mark.parametrize("changes", [(JITTER,), ()], ids=["jitter at both ends", "at the receiver alone"])
def test_under_errors_at_random_the_margin_is_that_of_the_sum(tmp_path, changes):
    file = with_coupling(tmp_path, FIBRE | {"jitter": THEIRS}, *changes)
    data, outage = link.of(file.mission), file.mission.requirement.outage
    rng = np.random.default_rng(3)
    count = 600_000
    x, y = 1e-6 + 3e-6 * rng.standard_normal(count), 2e-6 * rng.standard_normal(count)
    sent = data.beam.fall.loss_db(np.hypot(x, y) if changes else np.full(count, 10e-6))
    u, v = 1e-6 * rng.standard_normal(count), 0.5e-6 + 0.6e-6 * rng.standard_normal(count)
    end = data.receiving.end
    received = end.loss_db(u, v)
    lost = sent + received
    on_axis = Exposure.stated(data).on_axis_db
    lines, budget = lines_of(file)
    sampled = float(np.quantile(lost, 1.0 - outage)) - float(end.loss_db(0.0))
    assert budget.margin_db == pytest.approx(on_axis - sampled, abs=0.03)
    assert link_performance.margin_db(data) == pytest.approx(budget.margin_db, abs=1e-6)
    alone = float(np.quantile(received, 1.0 - outage)) - float(end.loss_db(0.0))
    added = -lines["Receive pointing loss"].value
    assert 0.0 < added < alone - 0.05 if changes else added == pytest.approx(alone, abs=0.02)
    under = link_performance.performance_under_jitter(data)
    assert under.margin_db == pytest.approx(budget.margin_db, abs=1e-6)
    assert under.short == pytest.approx(
        float(np.mean(lost - float(end.loss_db(0.0)) > on_axis - 3.0)), rel=0.05, abs=1e-4
    )
    power = 10.0 ** (-(lost - float(end.loss_db(0.0))) / 10.0)
    assert under.mean_loss_db == pytest.approx(-10.0 * math.log10(float(np.mean(power))), abs=0.01)


@pytest.mark.promise("link-98")
def test_the_outage_and_the_margin_for_it_do_not_ask_how_fast_the_errors_come(tmp_path):
    slow, fast = (
        link_performance.performance_under_jitter(link.of(link_file(tmp_path, NO_BEAMS, JITTER, each).mission))
        for each in ({"jitter.bandwidth": "1 Hz"}, {"jitter.bandwidth": "1 kHz"})
    )
    assert (slow.margin_db, slow.outage, slow.short) == (fast.margin_db, fast.outage, fast.short)
    assert fast.fades_per_s == pytest.approx(1000.0 * slow.fades_per_s, rel=1e-9)


@pytest.mark.promise("link-74")
def test_the_largest_rate_and_a_solved_key_keep_the_margin_of_both_ends(tmp_path):
    """The receiver moves about x alone, whose distribution has a closed form: a search asks for it 250 times."""
    moving = FIBRE | {"jitter": THEIRS | {"rms": ["1 urad", "0 urad"]}}
    file = with_coupling(tmp_path, moving, JITTER)
    rate = link_study.run_link_study(file).largest_rate_bit_s
    at = with_coupling(tmp_path, moving, JITTER, {"communication.data_rate": f"{rate!r} bit/s"})
    assert link_study.run_link_study(at).communication.margin_db == pytest.approx(3.0, abs=1e-6)
    spare = with_coupling(tmp_path, moving, JITTER, {"communication.data_rate": "150 Mbit/s"})
    solved = link_study.solve_key(spare, "communication.coupling.jitter.rms")
    assert link_study.run_link_study(solved.file).communication.margin_db == pytest.approx(3.0, abs=1e-6)
    assert solved.solved.intervals[0].low_open and solved.value < 1e-5


@pytest.mark.promise("link-74")
def test_fades_of_both_ends_come_oftener_than_those_of_one(tmp_path):
    one = link_performance.performance_under_jitter(link.of(link_file(tmp_path, NO_BEAMS, JITTER).mission))
    still = link.of(with_coupling(tmp_path, FIBRE, JITTER).mission)
    both = link.of(with_coupling(tmp_path, FIBRE | {"jitter": THEIRS}, JITTER).mission)
    alone, found = (link_performance.performance_under_jitter(each) for each in (still, both))
    assert one.fades_per_s < alone.fades_per_s < found.fades_per_s
    assert found.short > alone.short > one.short
    slow = {"communication.data_rate": "150 Mbit/s"}
    theirs = link_performance.performance_under_jitter(
        link.of(with_coupling(tmp_path, FIBRE | {"jitter": THEIRS}, slow).mission)
    )
    assert 0.0 < theirs.fades_per_s < 1000.0 and theirs.fade_s > 0.0


def test_a_receiver_off_its_axis_may_gain_by_its_errors(tmp_path):
    table = FIBRE | {"lateral_error": "4 um", "focal_length": "1 m", "jitter": THEIRS}
    under = Exposure.stated(link.of(with_coupling(tmp_path, table, JITTER).mission))
    asked = under.on_axis_db + 0.1
    assert under.both.received.loss_db[0] < -0.5
    assert 0.0 < under.short_of(asked) < 1.0
    assert under.short_of(asked) == pytest.approx(under.both.beyond(-0.1), abs=1e-9)


def test_a_detector_that_no_error_of_its_own_leaves_dark_has_the_fades_of_the_transmitter(tmp_path):
    slow = {"communication.data_rate": "1 bit/s"}
    still, moved = (
        link_performance.performance_under_jitter(link.of(with_coupling(tmp_path, table, JITTER, slow).mission))
        for table in (DETECTOR, DETECTOR | {"jitter": THEIRS})
    )
    assert moved.fades_per_s == pytest.approx(still.fades_per_s)


def test_beside_a_transmitter_that_stands_still_a_fade_is_a_crossing_of_what_is_left(tmp_path):
    slow, theirs = {"communication.data_rate": "150 Mbit/s"}, THEIRS | {"rms": ["2 urad", "2 urad"]}
    data = link.of(with_coupling(tmp_path, FIBRE | {"jitter": theirs}, slow).mission)
    found, under = link_performance.performance_under_jitter(data), Exposure.stated(data)
    left = under.on_axis_db - data.requirement.margin_db - float(data.beam.fall.loss_db(10e-6))
    jitter, speed = data.receiving.jitter, 2.0 * math.pi * 80.0 * 2e-6
    rate = level_crossing_rate_hz(jitter, (speed, speed), data.receiving.end.error_rad(left))
    assert found.fades_per_s == pytest.approx(float(rate), rel=1e-6)


def test_what_the_receivers_pointing_costs_counts_for_codes_and_the_way_back(tmp_path):
    fading = {"communication.fading": {"code": "ccsds-k7-1-2", "interleaving": "none", "bit_error_ratio": 1e-6}}
    still, off = (
        link.of(with_coupling(tmp_path, FIBRE | {"pointing_error": error}, fading).mission)
        for error in ("0 urad", "2 urad")
    )
    lost = off.receive_pointing_db
    assert lost > 0.2
    assert CodedBeam.of(off).on_axis_db == pytest.approx(CodedBeam.of(still).on_axis_db - lost, abs=1e-9)
    fall, reach = off.beam.fall, _return_reach(off)
    assert reach == pytest.approx(min(fall.half_angle_rad, fall.error_rad(float(link.margin_of_error(off, 0.0)))))


def test_an_input_is_not_moved_to_where_the_receiver_takes_no_light(tmp_path):
    m = with_coupling(tmp_path, FIBRE | {"defocus": "700 nm"}).mission
    assert link.beam_passes(m) and not link.beam_passes(m.with_value("communication.wavelength_m", 1.3e-6))
    m = link_file(tmp_path, NO_BEAMS, {"communication.coupling": MULTI, "terminals.geo_obscuration": 0.3}).mission
    assert link.beam_passes(m)
    assert not link.beam_passes(m.with_value("communication.coupling.numerical_aperture", 0.03))


@pytest.mark.promise("link-75")
def test_a_twin_has_the_errors_of_the_loop(tmp_path):
    """The errors that a loop leaves stand at both ends: by drawing pairs of them."""
    data = link.of(with_coupling(tmp_path, FIBRE | {"twin": True}, JITTER).mission)
    rng = np.random.default_rng(5)
    radius = np.abs(rng.standard_normal(3000)) * 4e-6
    errors = ErrorDistribution(radius, np.full(radius.size, 1.0 / radius.size))
    under = Exposure.of(data, errors.quantile_rad(0.997), errors.beyond, lambda: errors)
    sent, received = (rng.permutation(np.repeat(radius, 500)) for _ in range(2))
    end, fall = data.receiving.end, data.beam.fall
    lost = fall.loss_db(sent) + end.loss_db(received) - float(end.loss_db(0.0))
    assert under.outage_loss_db == pytest.approx(float(np.quantile(lost, 1.0 - data.requirement.outage)), abs=0.05)
    stated = link_performance.margin_db(data)
    again = replace(data, jitter=None)
    gaussian = GaussianErrors.of(Jitter((1e-6, 0.0), (3e-6, 2e-6)))
    of_loop = Exposure.of(
        again, gaussian.quantile_rad(1.0 - data.requirement.outage), gaussian.beyond, lambda: gaussian
    )
    assert of_loop.margin_db == pytest.approx(stated, abs=1e-9)


@pytest.mark.promise("link-75")
def test_runs_and_campaigns_draw_the_twins_loss_from_the_loops_errors(tmp_path):
    """By the histogram of a loop's radial errors: in a row of a campaign, and in the report of a run."""
    file = with_coupling(tmp_path, FIBRE | {"twin": True}, JITTER)
    counts = np.zeros((1, bin_edges_rad().size - 1), dtype=np.int64)
    rng = np.random.default_rng(8)
    counts[0] = np.histogram(np.abs(rng.normal(0.0, 4e-6, 400_000)), bin_edges_rad())[0]
    errors, data = Binned.of(counts[0]), link.of(file.mission)
    kept = 1.0 - file.mission.requirement.outage
    expected = Exposure.of(data, errors.quantile_rad(kept), errors.beyond, lambda: errors)
    runs = SimpleNamespace(quantile_rad=errors.quantile_rad, beyond=errors.beyond, histogram=counts)
    assert _exposure(data, runs).margin_db == pytest.approx(expected.margin_db, abs=1e-12)
    still = Jitter((0.0, 0.0), (4e-6, 0.0))
    shown = link_performance.performance(data, "loop", "", "", errors, still, None)
    assert shown.margin_db == pytest.approx(expected.margin_db, abs=1e-12)
    alone = link.of(with_coupling(tmp_path, FIBRE, JITTER).mission)
    assert shown.margin_db < link_performance.performance(alone, "loop", "", "", errors, still, None).margin_db - 0.5


@pytest.mark.promise("link-75")
def test_words_and_coded_bits_of_a_twin_have_all_of_the_margin_and_of_another_what_its_errors_leave(tmp_path):
    fading = {"communication.fading": {"code": "ccsds-k7-1-2", "interleaving": "none", "bit_error_ratio": 1e-6}}
    receivers = (
        {"twin": True},
        {"jitter.bias": ["1 urad", "0 urad"], "jitter.rms": ["1 urad", "2 urad"], "jitter.bandwidth": "5 Hz"},
    )
    for own in receivers:
        data = link.of(with_coupling(tmp_path, FIBRE | own, JITTER | fading).mission)
        lost = 0.0 if "twin" in own else data.receive_pointing_db
        assert data.receive_pointing_db > 0.1
        on_axis_db = Exposure.stated(data).on_axis_db
        words, beam = FadeMargin.of(data), CodedBeam.of(data)
        assert words.loss_db == pytest.approx(on_axis_db - lost - data.requirement.margin_db, abs=1e-12)
        assert beam.on_axis_db == pytest.approx(on_axis_db - lost, abs=1e-12)
        ends = data.receiving.end if "twin" in own else None
        assert words.light.end == beam.light.end == ends
        assert words.light.half_angle_rad == pytest.approx(data.beam.fall.half_angle_rad, rel=1e-12)


# ------------------------------------------------------------------------------------------------------- refusals
@pytest.mark.promise("link-72", "link-73", "link-74")
@pytest.mark.parametrize(
    ("table", "changes", "said"),
    [
        ({"into": "single-mode fibre"}, {}, "mode_radius is missing"),
        (FIBRE | {"mode_radius": "0 um"}, {}, "mode_radius above 0 m, at most 1 m"),
        (FIBRE | {"mode_radius": "5 um"}, {}, "focal_length is missing"),
        (FIBRE | {"lateral_error": "1 um"}, {}, "focal_length is missing"),
        (FIBRE | {"core_radius": "25 um"}, {}, 'core_radius does not belong to into = "single-mode fibre"'),
        (MULTI | {"mode_radius": "best"}, {}, 'mode_radius does not belong to into = "multi-mode fibre"'),
        (DETECTOR | {"angular_error": "1 mrad"}, {}, 'angular_error does not belong to into = "detector"'),
        (
            FIBRE | {"pointing_error": "1 urad", "twin": True},
            {},
            "pointing_error stands beside twin: both say how the receiver points",
        ),
        (
            FIBRE | {"mode_radius": "5 um", "focal_length": "50 cm", "angular_error": "0.8 rad"},
            {},
            "coupling.angular_error turns the fibre's mode out of the aperture: beyond 668.2 mrad",
        ),
        (
            FIBRE | {"focal_length": "50 cm", "angular_error": "0.9 rad"},
            {},
            "coupling.angular_error turns the fibre's mode out of the aperture: beyond 819.4 mrad",
        ),
        (FIBRE | {"coma": "-0.8 um"}, {}, "coupling.coma is above half the wavelength (775 nm)"),
        (FIBRE | {"defocus": "775.1 nm"}, {}, "coupling.defocus is above half the wavelength (775 nm)"),
        (FIBRE | {"astigmatism": "-775.1 nm"}, {}, "coupling.astigmatism is above half the wavelength (775 nm)"),
        (FIBRE | {"spherical": "775.1 nm"}, {}, "coupling.spherical is above half the wavelength (775 nm)"),
        (FIBRE | {"angular_error": "1 mrad"}, {}, "focal_length is missing"),
        (MULTI | {"detector_radius": "1 um"}, {}, 'detector_radius or into = "detector"'),
        (DETECTOR | {"focus": "1 um"}, {}, "coupling.focus is no key of [communication.coupling]"),
        (FIBRE | {"jitter": THEIRS, "twin": True}, {}, "jitter stands beside twin: both say how the receiver points"),
        (FIBRE | {"jitter": THEIRS, "pointing_error": "1 urad"}, {}, "pointing_error stands beside jitter"),
        (FIBRE | {"twin": True}, {"requirement.outage": None}, "requirement.outage is missing"),
        (FIBRE | {"jitter": THEIRS}, {"requirement.outage": None}, "requirement.outage is missing"),
        (
            MULTI | {"numerical_aperture": 0.05},
            {"terminals.geo_obscuration": 0.5},
            "numerical_aperture no more than terminals.geo_obscuration stops",
        ),
    ],
)
def test_what_does_not_fit_is_refused_with_its_key(tmp_path, table, changes, said):
    with pytest.raises(MissionError) as refused:
        with_coupling(tmp_path, table, changes)
    key, _, reason = said.partition(" ")
    assert key in str(refused.value) and reason in str(refused.value)


@pytest.mark.parametrize(
    ("table", "changes"),
    [
        (FIBRE | {"defocus": "775 nm", "coma": "-775 nm"}, {}),
        (FIBRE | {"lateral_error": "0 um", "angular_error": "0 mrad"}, {}),
        (FIBRE | {"focal_length": "50 cm", "angular_error": "0.819 rad"}, {}),
        (FIBRE | {"mode_radius": "5 um", "focal_length": "50 cm", "angular_error": "0.668 rad"}, {}),
        (FIBRE | {"twin": False, "pointing_error": "1 urad"}, {}),
        (FIBRE | {"twin": False}, {"requirement.outage": None}),
        (MULTI | {"numerical_aperture": 0.0625}, {"terminals.geo_obscuration": 0.5}),
        (MULTI | {"numerical_aperture": 0.01}, {}),
    ],
)
def test_what_meets_a_limit_of_the_coupling_is_taken(tmp_path, table, changes):
    assert with_coupling(tmp_path, table, changes).mission.communication.coupling.into == table["into"]


def test_a_receiver_that_is_stated_to_point_without_error_is_told_from_one_of_which_nothing_is_said(tmp_path):
    name = "Receive pointing loss"
    for given, basis in (({"pointing_error": "0 rad"}, "error = 0 rad"), ({}, "taken as none")):
        lines, budget = lines_of(with_coupling(tmp_path, FIBRE | given))
        assert (lines[name].value, lines[name].basis) == (0.0, basis)
        assert name in budget.at_zero
        assert (lines[name].source != "not given") == bool(given)


def test_the_loss_of_a_receiver_that_moves_says_whose_errors_those_are_and_how_often_they_exceed_it(tmp_path):
    for own, moving in (("twin", {"twin": True}), ("jitter.rms", {"jitter": THEIRS})):
        file = with_coupling(tmp_path, FIBRE | moving, JITTER)
        data = link.of(file.mission)
        (line,) = [
            each
            for each in _coupling_lines(SimpleNamespace(sources={}, table="communication"), data)
            if each.name == "Receive pointing loss"
        ]
        share = f"exceeded for {100.0 * file.mission.requirement.outage:g} % of the time"
        assert line.basis == f"what it adds to the pointing loss, both together {share}"
        assert line.regime == "errors of the two ends independent"
        assert line.source == source_text({}, f"communication.coupling.{own}")


@pytest.mark.parametrize(
    ("radius_um", "aperture", "few"), [(25.0, 0.2, False), (4.0, 0.1, True), (None, 0.1, False), (4.0, None, False)]
)
def test_a_fibre_of_few_modes_is_warned_of(radius_um, aperture, few):
    radius_m = None if radius_um is None else radius_um * 1e-6
    said = _few_modes(SimpleNamespace(core_radius_m=radius_m, numerical_aperture=aperture), 1.55e-6)
    assert said.startswith("the fibre has V = 1.62, too few modes") if few else said == ""


CUT_BEAM = {
    "communication.beam": {"profile": "gaussian", "radius": "23 mm", "m_squared": 1.2},
    "conventions.pointing_loss": "pattern",
    "communication.transmit_power": "9 W",
}


def test_fades_beside_a_receiver_that_hardly_moves_are_those_of_the_transmitter_alone_whatever_its_beam(tmp_path):
    wide = {"jitter.rms": ["6 urad", "5 urad"]}
    barely = {"jitter.bias": ["0 urad", "0 urad"], "jitter.rms": ["1e-3 urad"] * 2, "jitter.bandwidth": "5 Hz"}
    alone, both = (
        link_performance.performance_under_jitter(
            link.of(with_coupling(tmp_path, FIBRE | own, JITTER, CUT_BEAM, wide).mission)
        )
        for own in ({}, barely)
    )
    assert both.fades_per_s == pytest.approx(alone.fades_per_s, rel=2e-3)
    assert both.fade_s == pytest.approx(alone.fade_s, rel=2e-3)


def test_a_beam_that_is_like_another_has_lost_the_margin_at_the_same_error(tmp_path):
    data = link.of(with_coupling(tmp_path, FIBRE | {"twin": True}, JITTER, CUT_BEAM).mission)
    found, fall = FadeMargin.of(data), data.beam.fall
    like = GaussianFall(found.light.half_angle_rad)
    assert float(like.loss_db(fall.error_rad(found.loss_db))) == pytest.approx(found.loss_db, rel=1e-9)
    assert abs(like.half_angle_rad / fall.half_angle_rad - 1.0) > 1e-3


@pytest.mark.promise("link-74")
def test_the_penalty_without_a_code_counts_the_losses_of_both_ends(tmp_path):
    """By pairs of errors, and by the receiver's own curve."""
    receiver = received_with("preamplified dpsk", bit_error_ratio=1e-3)
    file = with_coupling(tmp_path, FIBRE | {"twin": True}, JITTER, receiver)
    data, found = link.of(file.mission), link_study.run_link_study(file).under_jitter.uncoded_penalty_db
    rng = np.random.default_rng(11)
    x, y = rng.normal(1e-6, 3e-6, (2, 400_000)), rng.normal(0.0, 2e-6, (2, 400_000))
    sent, received = np.hypot(x, y)
    end, rate = data.receiving.end, data.table.data_rate_bit_s
    lost = GaussianFall(data.beam.fall.half_angle_rad).loss_db(sent) + end.loss_db(received) - float(end.loss_db(0.0))
    needed = float(data.receiver.required_power_w(rate))

    def mean_ratio(penalty_db):
        return float(np.mean(data.receiver.bit_error_ratio_at(needed * 10.0 ** ((penalty_db - lost) / 10.0), rate)))

    drawn = brentq(lambda each: math.log(mean_ratio(each) / data.receiver.bit_error_ratio), 0.0, 40.0)
    assert found == pytest.approx(drawn, abs=0.1) and drawn > 1.0


AHEAD = {"point_ahead.corrected": False, "point_ahead.transverse_velocity": "500 m/s"}
READ = {
    "static": ({"communication.coupling": FIBRE | {"pointing_error": "4 urad"}}, AHEAD),
    "random": ({"communication.coupling": DETECTOR | {"jitter": THEIRS}}, JITTER, AHEAD),
    "wavefront": (
        {"communication.coupling": MULTI, "communication.strehl": None, "communication.wavefront_error": "90 nm"},
        JITTER,
    ),
}


@pytest.mark.parametrize("case", READ)
def test_readings_and_ideal_receivers_count_what_the_receiver_and_the_point_ahead_cost(tmp_path, case):
    """Each is held against the mission that has what was read or found as its own."""
    rates, errors = [1e8, 3e8], [0.0, 12e-6]
    wanted = {"communication.data_rate": "250 Mbit/s", "requirement.pointing_error": "7 urad"}
    m = link_file(tmp_path, NO_BEAMS, *READ[case], wanted).mission
    data = link.of(m)
    readings = {(each.pointing_loss, each.strehl): each.photons_per_bit for each in link.implied_sensitivity(data)}
    maps = link.convention_maps(data, rates, errors)
    assert maps.keys() == readings.keys() and len(maps) == (2 if case == "wavefront" else 4)
    for (loss, strehl), margins in maps.items():
        said = {"conventions.pointing_loss": loss}
        said |= {} if case == "wavefront" else {"conventions.strehl": strehl}
        own = link_file(tmp_path, NO_BEAMS, *READ[case], wanted, said).mission
        np.testing.assert_allclose(margins, link.margin_map(link.of(own), rates, errors), rtol=0, atol=1e-9)
        if case != "random" or loss == m.conventions.pointing_loss:  # else what is added depends on the reading
            needed = own.with_value("communication.receiver_sensitivity_photon_bit", readings[loss, strehl])
            assert float(link.margin_map(link.of(needed), 250e6, 7e-6)[0, 0]) == pytest.approx(3.0, abs=1e-9)
    for error_rad in (None, 12e-6):
        for each in link.ideal_receivers(data, {}, error_rad):
            with_it = m.with_value("communication.receiver_sensitivity_photon_bit", each.photons_per_bit)
            at = m.communication.pointing_error_rad if error_rad is None else error_rad
            margin = float(link.margin_map(link.of(with_it), 250e6, at)[0, 0])
            assert each.margin_db == pytest.approx(margin, abs=1e-9)


@pytest.mark.parametrize("table", [FIBRE, MULTI, DETECTOR], ids=["fibre", "multi-mode", "detector"])
def test_the_exposure_of_a_link_without_jitter_has_the_static_loss_of_its_receiver(tmp_path, table):
    lines, budget = lines_of(with_coupling(tmp_path, table | {"pointing_error": "6 urad"}, AHEAD))
    data = link.of(with_coupling(tmp_path, table | {"pointing_error": "6 urad"}, AHEAD).mission)
    found = Exposure.stated(data)
    lost = -lines["Receive pointing loss"].value
    assert lost > 0.01 or table is MULTI
    assert (found.received_db, found.received_mean_db) == pytest.approx((lost, lost), abs=1e-9)
    sent = -(lines["Pointing loss"].value + lines["Point-ahead loss"].value)
    assert found.outage_loss_db == pytest.approx(sent + lost, abs=1e-9)
    assert found.margin_db == pytest.approx(budget.margin_db, abs=1e-9)
    assert found.short_of(budget.margin_db - 0.01) == 0.0
    assert found.short_of(budget.margin_db + 0.01) == 1.0
