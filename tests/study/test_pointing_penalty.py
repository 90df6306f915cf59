"""What residuals cost the link: with hysteresis against without, and what a sine and an ensemble stand for."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from microrad.link.pointing import Jitter
from microrad.loop.pointing_loop.ensemble import bin_edges_rad
from microrad.mirror import Variant
from microrad.study import pointing_penalty, study


def case(source, controller, mirror, margin_db, rate=0.0):
    return SimpleNamespace(
        source=source, controller=controller, mirror=mirror, margin_db=margin_db, data_rate_bit_s=rate
    )


def test_hysteresis_costs_what_the_same_loop_has_more_without_it():
    cases = (
        case("sine", "PI", Variant.STRAIGHT, 5.0, 9.0),
        case("sine", "PI", Variant.GIVEN, 3.0, 4.0),
        case("sine", "PI", Variant.COMPARISON, 4.5, 8.0),
        case("sine", "LQG", Variant.GIVEN, 2.0, 1.0),  # not run without
        case("noise", "PI", Variant.GIVEN, 1.0, 1.0),
        case("noise", "LQG", Variant.STRAIGHT, 7.0, 1.0),
        case("noise", "LQG", Variant.GIVEN, 6.0, 0.5),
    )
    found = [(c.source, c.controller, c.mirror, c.margin_db, c.data_rate_bit_s) for c in pointing_penalty.costs(cases)]
    assert found == [
        ("sine", "PI", "given", -2.0, -5.0),
        ("sine", "PI", "comparison", -0.5, -1.0),
        ("noise", "LQG", "given", -1.0, -0.5),
    ]
    held = pointing_penalty.LinkPerformance(0.003, 1e-6, cases, ())
    assert held.case("noise", "LQG", "given") is cases[6]
    assert held.case("noise", "LQG", "comparison") is held.case("other", "PI", "given") is None


@pytest.fixture
def told(monkeypatch):
    """What the link's performance is asked for."""
    monkeypatch.setattr(pointing_penalty, "performance", lambda *given: given)


@pytest.mark.parametrize("radial", [False, True])
def test_a_sine_is_its_steady_error_on_one_axis_or_on_two_alike(told, radial):
    error = np.array([[9.0, 0.0], [1.0, 7.0], [-3.0, 7.0], [5.0, 7.0]])
    run = SimpleNamespace(
        freq_hz=25.0, controller="PID", mirror="given", trace=SimpleNamespace(error_rad=error, steady=slice(1, None))
    )
    data, source, controller, mirror, spread, jitter, motion = pointing_penalty._sine("link", radial, run)
    assert (data, source, controller, mirror, motion) == ("link", "sine of 25 Hz", "PID", "given", None)
    np.testing.assert_allclose(spread.radius_rad, np.array([1.0, 3.0, 5.0]) * (math.sqrt(2.0) if radial else 1.0))
    np.testing.assert_allclose(spread.share, 1.0 / 3.0)
    rms = math.sqrt((0.0 + 16.0 + 16.0) / 3.0)
    assert jitter == Jitter((1.0, radial * 1.0), (pytest.approx(rms), pytest.approx(radial * rms)))


@pytest.mark.parametrize("axes", [1, 2])
@pytest.mark.parametrize("mirror", [Variant.GIVEN, Variant.STRAIGHT])
def test_an_ensemble_is_its_mean_and_what_moves_about_it(told, monkeypatch, axes, mirror):
    counts = np.zeros(bin_edges_rad().size - 1, dtype=np.int64)
    counts[[3, 10]] = 4, 1
    left = SimpleNamespace(axis_mean_rad=(3.0, -1.0)[:axes], axis_rms_rad=(5.0, 1.0)[:axes], radial_counts=counts)
    verified = SimpleNamespace(
        simulated={mirror: left}, spectrum_rad2_hz=np.array([[1.0, 4.0], [2.0, 5.0], [3.0, 6.0]])[:, :axes],
        design=SimpleNamespace(name="LQG"),
    )  # fmt: skip
    monkeypatch.setattr(pointing_penalty.pointing, "motion_of_spectrum", lambda freq, psd: (freq, psd.tolist()))
    fine = SimpleNamespace(freq_hz="frequencies")
    _, source, name, of, spread, jitter, motion = pointing_penalty._fine("link", fine, verified, mirror)
    assert (source, name, of) == ("vibration and noise", "LQG", mirror)
    assert jitter == Jitter((3.0, -1.0 * (axes == 2)), (4.0, 0.0))
    second = [4.0, 5.0, 6.0] if axes == 2 else [0.0, 0.0, 0.0]
    known = ("frequencies", [[1.0, 2.0, 3.0], second])
    assert motion == (known if mirror is Variant.GIVEN else None)
    edges = bin_edges_rad()
    assert spread.share.sum() == pytest.approx(1.0)
    assert np.sum(spread.share[spread.radius_rad < edges[4]]) == pytest.approx(0.8)
    assert (
        edges[3] < spread.radius_rad[spread.share > 0].min() and spread.radius_rad[spread.share > 0].max() < edges[11]
    )
    mean_square = np.sum(spread.share * spread.radius_rad**2)
    exact = 0.8 * (edges[3] ** 2 + edges[4] ** 2) / 2 + 0.2 * (edges[10] ** 2 + edges[11] ** 2) / 2
    assert mean_square == pytest.approx(exact, rel=1e-12)


# ---------------------------------------------------------------------------------------------- whether a mission closes
@pytest.mark.parametrize(
    ("beacon", "answer", "possible", "margin_db", "closes"),
    [
        (True, True, True, 0.0, True),
        (True, True, True, -0.9e-9, True),
        (True, True, True, -1.1e-9, False),
        (False, True, True, 5.0, False),
        (True, False, True, 5.0, False),
        (True, True, False, 5.0, False),
    ],
)
@pytest.mark.parametrize("fine", [False, True])
def test_a_mission_closes_with_all_three_links_under_the_judged_loop(beacon, answer, possible, margin_db, closes, fine):
    judged, other = SimpleNamespace(possible=possible), SimpleNamespace(possible=not possible)
    whole = SimpleNamespace(
        beacon=SimpleNamespace(closes=beacon),
        answer=SimpleNamespace(closes=answer),
        achieved=other if fine else judged,
        fine_case=judged if fine else None,
        margin_db=margin_db,
    )
    assert study.Study.closes.fget(whole) is closes


def test_the_margin_is_that_of_the_judged_loop_and_all_requirements_have_to_be_met():
    achieved, fine = SimpleNamespace(margin_db=1.0), SimpleNamespace(margin_db=2.0)
    assert study.Study.margin_db.fget(SimpleNamespace(achieved=achieved, fine_case=None)) == 1.0
    assert study.Study.margin_db.fget(SimpleNamespace(achieved=achieved, fine_case=fine)) == 2.0
    met, missed = SimpleNamespace(met=True), SimpleNamespace(met=False)
    for lines, all_met in (((), True), ((met, met), True), ((met, missed), False), ((missed, met), False)):
        assert study.Study.met.fget(SimpleNamespace(requirements=lines)) is all_met


@pytest.mark.parametrize(
    ("highest", "most"), [(math.inf, 30.0), (3e9, 10.0), (9e9, 30.0), (3e8, 1.0)], ids=["none", "slow", "fast", "at it"]
)
def test_a_map_of_the_margin_goes_as_far_as_the_receiver_does_and_to_three_times_the_larger_error(
    monkeypatch, highest, most
):
    for name in ("margin_map", "convention_maps", "implied_sensitivity", "ideal_receivers"):
        monkeypatch.setattr(study.link, name, lambda *given: None)
    monkeypatch.setattr(study.link_study, "largest_rate", lambda data: 7.0)
    monkeypatch.setattr(study.link, "largest_pointing_error", lambda data, margin, rate: (margin, rate))
    receiver = None if math.isinf(highest) else SimpleNamespace(highest_data_rate_bit_s=highest)
    for allowed, budgeted in ((2e-6, 5e-6), (5e-6, 2e-6)):
        data = SimpleNamespace(
            requirement=SimpleNamespace(pointing_error_rad=allowed, margin_db=3.0),
            table=SimpleNamespace(data_rate_bit_s=3e8, pointing_error_rad=budgeted),
            receiver=receiver,
        )
        found = study.margin_map(data, {})
        assert found.data_rate_bit_s[[0, -1]] == pytest.approx([1e7, most * 3e8], rel=1e-12)
        assert found.pointing_error_rad[[0, -1]].tolist() == pytest.approx([0.0, 15e-6], rel=1e-12)
        assert found.largest_error_rad == (3.0, 3e8) and found.largest_rate_bit_s == 7.0

    def none(*given):
        raise study.link.LinkError("not even on axis")

    monkeypatch.setattr(study.link, "largest_pointing_error", none)
    assert math.isnan(study.margin_map(data, {}).largest_error_rad)


def test_the_paper_loop_is_judged_where_there_is_no_other_and_stands_beside_it_else(monkeypatch):
    monkeypatch.setattr(study.requirement, "of_beams", lambda links: ("beam",))
    monkeypatch.setattr(study.requirement, "of_fading", lambda links: ("fading",))
    monkeypatch.setattr(study.verdict, "of_fine_pointing", lambda *given: ("fine",))
    links = SimpleNamespace(data=SimpleNamespace(requirement=None), file=SimpleNamespace(sources=None))
    paper = ("residual",)
    assert study.judged(links, paper, None, None) == (("beam", "fading", "residual"), ())
    assert study.judged(links, paper, object(), None) == (("beam", "fading", "residual"), ())
    assert study.judged(links, paper, object(), object()) == (("beam", "fading", "fine"), paper)
