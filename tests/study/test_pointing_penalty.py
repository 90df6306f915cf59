"""What residuals cost the link: with hysteresis against without, and what a sine and an ensemble stand for."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from microrad.link.pointing import Jitter
from microrad.loop.pointing_loop.ensemble import bin_edges_rad
from microrad.mirror import Variant
from microrad.study import pointing_penalty


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
    assert jitter.bias_rad == (1.0, radial * 1.0)
    assert jitter.rms_rad == pytest.approx((rms, radial * rms))


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
    there = spread.radius_rad[spread.share > 0.0]
    assert edges[3] < there.min() and there.max() < edges[11]
    mean_square = np.sum(spread.share * spread.radius_rad**2)
    exact = 0.8 * (edges[3] ** 2 + edges[4] ** 2) / 2 + 0.2 * (edges[10] ** 2 + edges[11] ** 2) / 2
    assert mean_square == pytest.approx(exact, rel=1e-12)


def test_cases_of_a_link_are_those_of_each_sine_and_each_controller_on_each_mirror(monkeypatch):
    monkeypatch.setattr(pointing_penalty, "stated_outage", lambda requirement: requirement + 0.25)
    monkeypatch.setattr(
        pointing_penalty, "_sine", lambda data, radial, run: case(f"sine {run}", "PID", Variant.GIVEN, float(radial))
    )
    monkeypatch.setattr(
        pointing_penalty,
        "_fine",
        lambda data, fine, v, mirror: case("noise", v.name, mirror, fine[v.name, mirror], 2.0),
    )
    left = {("PI", Variant.GIVEN): 3.0, ("PI", Variant.STRAIGHT): 5.5, ("LQG", Variant.GIVEN): 4.0}

    class Fine(dict):
        verified = (
            SimpleNamespace(name="PI", simulated={Variant.GIVEN: 0, Variant.STRAIGHT: 0}),
            SimpleNamespace(name="LQG", simulated={Variant.GIVEN: 0}),
        )

    data = SimpleNamespace(requirement=0.5, beam=SimpleNamespace(fall=SimpleNamespace(half_angle_rad=6e-6)))
    for residual, radial in (("radial", 1.0), ("per-axis", 0.0)):
        found = pointing_penalty.performance_of_loops(data, residual, ("a", "b"), Fine(left))
        assert (found.outage, found.half_angle_rad) == (0.75, 6e-6)
        told = [(c.source, c.controller, c.mirror, c.margin_db) for c in found.cases]
        assert told == [
            ("sine a", "PID", Variant.GIVEN, radial),
            ("sine b", "PID", Variant.GIVEN, radial),
            ("noise", "PI", Variant.GIVEN, 3.0),
            ("noise", "PI", Variant.STRAIGHT, 5.5),
            ("noise", "LQG", Variant.GIVEN, 4.0),
        ]
        assert [(c.source, c.controller, c.mirror, c.margin_db) for c in found.costs] == [
            ("noise", "PI", "given", -2.5)
        ]
    assert len(pointing_penalty.performance_of_loops(data, "radial", ("a",), None).cases) == 1


def test_errors_in_bins_lie_evenly_in_the_square_and_have_their_quantiles():
    edges = bin_edges_rad()
    counts = np.zeros(edges.size - 1, dtype=np.int64)
    counts[[7, 8, 20]] = 6, 3, 1
    binned = pointing_penalty.Binned.of(counts)
    assert binned.radius_rad.size == binned.share.size == 32 * counts.size
    seventh = slice(32 * 7, 32 * 8)
    squares = edges[7] ** 2 + (edges[8] ** 2 - edges[7] ** 2) * (np.arange(32) + 0.5) / 32
    np.testing.assert_allclose(binned.radius_rad[seventh], np.sqrt(squares), rtol=1e-12)
    np.testing.assert_allclose(binned.share[seventh], 0.6 / 32, rtol=1e-12)
    assert binned.share[32 * 20] == pytest.approx(0.1 / 32) and binned.share[32 * 9] == 0.0
    middle = math.sqrt(edges[7] ** 2 + 0.5 * (edges[8] ** 2 - edges[7] ** 2))
    assert binned.quantile_rad(0.3) == pytest.approx(middle, rel=1e-12)
    assert binned.quantile_rad(0.9) == pytest.approx(edges[9], rel=1e-12)


def test_each_loop_that_was_simulated_is_a_case_on_each_mirror(monkeypatch):
    monkeypatch.setattr(pointing_penalty, "_sine", lambda data, radial, run: case(f"{radial}", run, "given", 1.0))
    monkeypatch.setattr(pointing_penalty, "_fine", lambda data, fine, of, on: case(fine.name, of.name, on, 2.0))
    monkeypatch.setattr(pointing_penalty, "stated_outage", lambda required: required / 4.0)
    data = SimpleNamespace(requirement=0.01, beam=SimpleNamespace(fall=SimpleNamespace(half_angle_rad=7e-6)))
    verified = [SimpleNamespace(name=n, simulated=dict.fromkeys(on)) for n, on in (("PI", "ab"), ("LQG", "b"))]
    fine = SimpleNamespace(name="fine", verified=verified)
    for residual, radial in (("radial", True), ("per-axis", False)):
        found = pointing_penalty.performance_of_loops(data, residual, ("PID", "PI"), fine)
        assert (found.outage, found.half_angle_rad, found.costs) == (0.0025, 7e-6, ())
        rows = [(c.source, c.controller, c.mirror) for c in found.cases]
        sines = [(str(radial), "PID", "given"), (str(radial), "PI", "given")]
        assert rows == [*sines, ("fine", "PI", "a"), ("fine", "PI", "b"), ("fine", "LQG", "b")]
        assert len(pointing_penalty.performance_of_loops(data, residual, ("PID",), None).cases) == 1


def test_binned_errors_are_spread_evenly_in_the_square_and_have_the_histograms_quantiles():
    edges, counts = bin_edges_rad(), np.zeros(bin_edges_rad().size - 1, dtype=np.int64)
    counts[[2, 7, 40]] = 5, 3, 2
    found = pointing_penalty.Binned.of(counts)
    assert found.radius_rad.size == found.share.size == 32 * counts.size
    here = found.share.reshape(-1, 32)
    np.testing.assert_allclose(here[[2, 7, 40]].sum(axis=1), [0.5, 0.3, 0.2])
    steps = np.diff(found.radius_rad[32 * 7 : 32 * 8] ** 2)
    np.testing.assert_allclose(steps, (edges[8] ** 2 - edges[7] ** 2) / 32, rtol=1e-9)
    assert found.radius_rad[32 * 7] ** 2 == pytest.approx(edges[7] ** 2 + steps[0] / 2, rel=1e-12)
    for share, at, within in ((0.5, 2, 1.0), (0.65, 7, 0.5), (0.85, 40, 0.25)):
        wanted = edges[at] ** 2 + within * (edges[at + 1] ** 2 - edges[at] ** 2)
        assert found.quantile_rad(share) == pytest.approx(math.sqrt(wanted), rel=1e-12)
    assert (found.beyond(edges[8]), found.beyond(edges[3])) == pytest.approx((0.2, 0.5))
