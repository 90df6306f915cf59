"""The worst case over an identified mirror: against one mirror at a time, scans by hand, and the loop in time."""

import re
import sys
from dataclasses import replace
from itertools import product
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.testing import assert_allclose

import several_axes
from campaign_files import MIRROR
from learning_loops import loop_of
from microrad.core import lti
from microrad.loop import control, coupled_study, worst_case
from microrad.loop.disturbance import Misalignment
from microrad.loop.disturbance.windows import ErrorIndex
from microrad.loop.pointing_loop.design import design_plant, whole_plant
from microrad.loop.pointing_loop.linear import close, stationary
from microrad.loop.pointing_loop.loop import (
    LoopController,
    assemble,
    assemble_whole,
    decoupling,
    nominal_axis_gain,
)
from microrad.loop.pointing_loop.windows import windowed_errors
from microrad.loop.worst_case import APE, Extent, Simulated, Subject, batch, in_time, search
from microrad.mirror import coupled, from_table, spread
from microrad.mirror.hysteresis import PrandtlIshlinskii, rest_gain
from microrad.mirror.model import linearised
from microrad.mission.file import load_loop
from microrad.report.fine_pointing.worst_case import worst_case_data, worst_case_text
from places import benchmark
from scenes import scene_of
from shipped import DEFAULT

INDICES = (APE, ErrorIndex("MPE", 0.01), ErrorIndex("RPE", 0.01), ErrorIndex("PDE", 0.01, 0.02))
PARAMETERS = ("bouc_wen.d1", "linear.poles.1", "linear.pole_dampings.1")
SMALL = Extent(draws=20, most_sensitive=3)


def table_of(folder, errors=(0.02, 0.03, 0.1), correlation="", **changes):
    """A mirror of one mode, damped little, with what is known of its gain, frequency and damping."""
    text = MIRROR.replace("pole_dampings = [0.5]", "pole_dampings = [0.1]").replace("1 kHz", "600 Hz")
    names = str(list(PARAMETERS)).replace("'", '"')
    text += f"\n[uncertainty]\nparameters = {names}\nstandard_errors = {list(errors)}\n{correlation}"
    (folder / "mirror.toml").write_text(text, encoding="utf-8")
    return load_loop(DEFAULT, folder / "mirror.toml")[0]


def subject_of(file, family=control.PI, values=(60.0, 1500.0)):
    """The loop of a mission under a controller of one axis, and that controller; nothing is tuned."""
    scene = scene_of(file)
    axis = family.build(design_plant(scene.axis), np.array(values))
    simulated = Simulated(scene.axis, assemble(axis.name, scene.axis, axis), at_rest=False)
    return Subject(scene.axis, 2, simulated, worst_case.of_table(file.mission.mirror)), axis


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    return table_of(tmp_path_factory.mktemp("mirror"))


def by_itself(subject, axis, mirror):
    """Radial rms by index, and modulus margin, of one mirror in the functions that know no stacks."""
    loop = replace(subject.theory, mirror=mirror)
    errors = windowed_errors(close(loop, subject.controller), INDICES)
    rms = [np.sqrt(2.0) * np.linalg.norm([*each.left.values()]) for each in errors]
    return rms, control.loop_margins(design_plant(loop), axis).modulus


@pytest.mark.promise("pointing-73")
def test_the_worst_corner_is_that_of_a_scan_by_hand(file):
    subject, axis = subject_of(file)
    found = worst_case.worst_case(subject, 1, extent=replace(SMALL, draws=1))
    corners = []
    for signs in product((-1.0, 1.0), repeat=3):
        factors = 1.0 + 3.0 * np.array(signs) * np.array([0.02, 0.03, 0.1])
        mirror = from_table(spread.moved(file.mission.mirror, factors))
        loop = replace(subject.theory, mirror=mirror)
        rms = np.sqrt(2.0) * stationary(close(loop, subject.controller)).radial_rms_rad
        corners.append((signs, rms, control.loop_margins(design_plant(loop), axis).modulus))
    (largest,) = found.largest_rad
    signs, rms, _ = max(corners, key=lambda corner: corner[1])
    assert largest.value == pytest.approx(rms, rel=1e-9, abs=0.0)
    assert_allclose([largest.sigmas[name] for name in PARAMETERS], 3.0 * np.array(signs), rtol=1e-9)
    signs, _, modulus = min(corners, key=lambda corner: corner[2])
    assert found.smallest_modulus.value == pytest.approx(modulus, rel=1e-9, abs=0.0)
    # a resonance is nearest to -1 where it is least damped and the gain is highest
    assert signs[0] == 1.0 and signs[2] == -1.0
    assert_allclose([found.smallest_modulus.sigmas[name] for name in PARAMETERS], 3.0 * np.array(signs), rtol=1e-9)
    assert (found.corners, found.corners_left_out, found.unstable_corners) == (8, 0, 0)


@pytest.mark.promise("pointing-73")
@pytest.mark.parametrize(
    ("family", "values"),
    [pytest.param(control.PI, (60.0, 1500.0), marks=pytest.mark.endurance), (control.RESONANT_DAMPING, None)],
    ids=["optical", "both"],
)
def test_many_mirrors_at_once_have_the_figures_of_each_by_itself(file, family, values):
    if values is None:
        parameters = family.parameters(design_plant(scene_of(file).axis))
        values = [p.least * (p.most / p.least) ** 0.3 if p.log else 0.5 * (p.least + p.most) for p in parameters]
    subject, axis = subject_of(file, family, values)
    drawn = subject.known.drawn(6, 5)
    found = subject.figures(drawn, INDICES, 1)
    for (mirror, _), rms, modulus in zip(drawn, found.rms_rad, found.modulus, strict=True):
        expected, margin = by_itself(subject, axis, mirror)
        assert_allclose(rms, expected, rtol=1e-9)
        assert modulus == pytest.approx(margin, rel=1e-9, abs=0.0)
    assert found.unstable == 0 and np.ptp(found.modulus) > 1e-3


@pytest.fixture(scope="module")
def two_axes():
    """The page's mirror of two axes under PI controllers that nobody tuned."""
    scene = several_axes.scene_of(several_axes.two_axes())
    plant = coupled_study.plants(scene)[0]
    one = control.PI.build(coupled_study.whole.alone(plant, 0), np.array([3.0, 800.0]))
    both = coupled_study.whole.side_by_side("PI", [one, one])
    controller = assemble_whole("PI", scene.rest, both.system, both.anti_windup)
    subject = Subject(
        scene.rest,
        1,
        Simulated(scene.loop, controller, at_rest=True),
        worst_case.of_several_axes(scene.mirror),
    )
    return subject, both


@pytest.mark.promise("pointing-73")
def test_mirrors_of_two_axes_have_the_least_singular_value_of_the_whole(two_axes):
    subject, both = two_axes
    drawn = subject.known.drawn(6, 5)
    found = subject.figures(drawn, (APE,), 1)
    to_drives = decoupling(subject.theory)
    for (mirror, _), rms, modulus in zip(drawn, found.rms_rad, found.modulus, strict=True):
        still = linearised(mirror, [rest_gain(model) for model in mirror.bank])
        loop = replace(subject.theory, mirror=still)
        assert rms[0] == pytest.approx(stationary(close(loop, subject.controller)).radial_rms_rad, rel=1e-9, abs=0.0)
        whole = coupled_study.whole_margins(whole_plant(loop, to_drives), both).modulus
        assert modulus == pytest.approx(whole, rel=1e-9, abs=0.0)
    assert found.unstable == 0


@pytest.mark.promise("pointing-73")
def test_a_stable_loop_settles_in_time_and_an_unstable_one_grows(tmp_path):
    file = table_of(tmp_path, errors=(0.25, 0.03, 0.1))
    subject, _ = subject_of(file)
    calm = worst_case.worst_case(subject, 1, extent=Extent(draws=1, most_sensitive=1, sigmas=0.1)).verified_in_time
    assert (calm.theory, calm.linear, calm.with_hysteresis, calm.agrees) == ("settles", "settles", "settles", True)
    assert not replace(calm, with_hysteresis="grows").agrees and not replace(calm, linear="grows").agrees
    wild = worst_case.worst_case(subject_of(file, values=(100.0, 1500.0))[0], 1, INDICES, SMALL)
    assert wild.unstable_corners > 0 and wild.smallest_modulus.value == 0.0
    assert wild.smallest_modulus.sigmas["bouc_wen.d1"] == pytest.approx(3.0)
    assert all(np.isinf(worst.value) for worst in wild.largest_rad) and np.isfinite(wild.nominal_rad).all()
    seen = wild.verified_in_time
    assert seen.pole > 1.0 and (seen.theory, seen.linear) == ("grows", "grows")
    text = worst_case_text(wild, 80)
    for words in (f"{wild.unstable_corners} of the corners", "unstable", "does not settle", "bouc_wen.d1", "+3.0"):
        assert words in text
    assert worst_case_data(wild)["verified_in_time"]["theory"] == "grows"


def test_an_error_that_neither_falls_nor_rises_has_not_settled():
    time = np.arange(900)[:, None]
    assert in_time.course(np.cos(time), 1.0) == "grows"
    assert in_time.course(np.exp(-time / 100.0) * np.cos(time), 1.0) == "settles"
    assert in_time.course(1e-3 * np.cos(time), 1.0) == "settles"


def test_a_sensor_slower_than_the_control_counts_as_in_a_design(file):
    subject, axis = subject_of(file)
    slow = replace(subject.theory, optical=replace(subject.theory.optical, every=2))
    subject = replace(subject, theory=slow)
    drawn = subject.known.drawn(3, 5)
    found = subject.figures(drawn, INDICES, 1)
    for (mirror, _), rms, modulus in zip(drawn, found.rms_rad, found.modulus, strict=True):
        expected, margin = by_itself(subject, axis, mirror)
        assert_allclose(rms, expected, rtol=1e-9)
        assert modulus == pytest.approx(margin, rel=1e-9, abs=0.0)


@pytest.mark.promise("pointing-75")
@pytest.mark.endurance
def test_the_benchmark_prints_how_long_two_thousand_mirrors_take(monkeypatch, capsys):
    bench, told = benchmark("worst_case"), []
    monkeypatch.setattr(bench, "tell", lambda what, do: told.append(what))  # each a command in a process of its own
    monkeypatch.setattr(bench, "ONE_BY_ONE", 1)
    monkeypatch.setattr(sys, "argv", ["benchmarks/worst_case.py"])
    bench.main()
    assert told[0] == "worst case, one axis, the whole command"
    assert re.fullmatch(
        r"figures of 2024 mirrors: \d+\.\d\d s at once, \d+\.\d s one by one\n", capsys.readouterr().out
    )


@pytest.mark.promise("pointing-75")
def test_it_comes_out_the_same_twice_and_on_any_number_of_threads(file):
    subject, _ = subject_of(file)
    extent = replace(SMALL, draws=100)
    first, again, alone = (worst_case.worst_case(subject, 3, INDICES, extent, threads) for threads in (2, 2, 1))
    assert first == again == alone
    assert first != worst_case.worst_case(subject, 4, INDICES, extent, 1)


@pytest.mark.promise("pointing-73")
def test_of_many_parameters_those_are_moved_one_by_one_that_matter_to_first_order(file, monkeypatch):
    assert worst_case.search.CLOSELY == 40
    subject, _ = subject_of(file)
    all_of_them = worst_case.worst_case(subject, 1, extent=replace(SMALL, draws=1))
    monkeypatch.setattr(worst_case.search, "CLOSELY", 2)
    two = worst_case.worst_case(subject, 1, extent=replace(SMALL, draws=1))
    assert two.most_sensitive == all_of_them.most_sensitive[:2]
    assert (all_of_them.corners, two.corners) == (8, 4)


def test_the_sensitivity_to_a_parameter_is_the_larger_change_of_the_two_ways(file):
    subject, axis = subject_of(file)
    found = worst_case.worst_case(subject, 1, INDICES, replace(SMALL, draws=1))

    def figures(factors):
        rms, modulus = by_itself(subject, axis, from_table(spread.moved(file.mission.mirror, factors)))
        return np.array([*rms, modulus])

    own, errors = figures(np.ones(3)), np.diag([0.02, 0.03, 0.1])
    for each in found.most_sensitive:
        error = errors[PARAMETERS.index(each.parameter)]
        up, down = (np.abs(figures(1.0 + sign * error) / own - 1.0) for sign in (1.0, -1.0))
        assert not np.allclose(up, down, rtol=0.01)
        assert_allclose([*each.rms, each.modulus], np.maximum(up, down), rtol=1e-6)


@pytest.mark.promise("pointing-73")
def test_draws_are_those_that_designs_have_to_hold_for(file):
    table = file.mission.mirror
    known = worst_case.of_table(table)
    for (mirror, sigmas), drawn in zip(known.drawn(8, 1), spread.draws(table, 8, 1), strict=True):
        np.testing.assert_array_equal(mirror.A, from_table(drawn).A)
        assert drawn.bouc_wen.d1_rad_v == pytest.approx(table.bouc_wen.d1_rad_v * (1 + 0.02 * sigmas[0]), rel=1e-12)


@pytest.mark.promise("pointing-73")
def test_corners_of_parameters_that_hang_together_are_as_far_off_as_of_others(tmp_path):
    """Two that are known by their sum alone do not go against each other by three standard errors."""
    known = worst_case.of_table(table_of(tmp_path, correlation="correlation = [-0.99, 0.0, 0.1]\n").mission.mirror)
    correlation = known.rows @ known.rows.T
    assert correlation[0, 1] == pytest.approx(-0.99)
    across = worst_case.search._independent(known.rows, (1, 0, 2), 10)
    assert_allclose(across @ across.T, np.eye(3), atol=1e-12)
    for signs in product((-1.0, 1.0), repeat=3):
        off = known.rows @ (3.0 * np.array(signs) @ across)
        assert off @ np.linalg.solve(correlation, off) == pytest.approx(27.0)
        assert off[1] == pytest.approx(3.0 * signs[0])  # the first one in all its standard error, the next in its rest
        assert off[0] == pytest.approx(-0.99 * 3.0 * signs[0] + np.sqrt(1 - 0.99**2) * 3.0 * signs[1])


@pytest.mark.promise("pointing-73")
def test_no_corner_turns_a_value(tmp_path):
    known = worst_case.of_table(table_of(tmp_path, errors=(0.6, 0.03, 0.1)).mission.mirror)
    _, sigmas = known.moved(np.array([-3.0, 1.0, 0.0]))
    assert_allclose(sigmas, [-0.9 / 0.6, 1.0, 0.0], atol=1e-12)
    assert known.moved(np.array([0.0, 0.0, 100.0])) is None  # a pair of poles without damping below 1


@pytest.mark.promise("pointing-73", "pointing-74")
def test_a_larger_mirror_is_looked_at_less_often():
    assert Extent.for_states(16) == Extent(1000, 10, 3.0)
    assert Extent.for_states(17) == Extent(200, 7, 3.0)


def test_a_mirror_of_several_axes_moves_as_its_file_says():
    mirror = several_axes.two_axes()
    known = worst_case.of_several_axes(mirror)
    moved, sigmas = known.moved(3.0 * known.rows[0])
    assert sigmas[0] == pytest.approx(3.0)
    assert moved.A[0, 0] == pytest.approx(mirror.mirror.A[0, 0] - 3.0 * 0.4)
    with pytest.raises(ValueError, match="has no table uncertainty, so nothing can be drawn; `microrad identify`"):
        worst_case.of_several_axes(replace(mirror, known=None))
    assert coupled.drawn(mirror, 2, 1)[1][0].mirror.A[0, 0] == coupled.draws(mirror, 2, 1)[1].mirror.A[0, 0]


# ------------------------------------------------------------------------------------------------ its parts by hand
def test_a_quantile_of_draws_is_the_value_of_a_draw_though_others_are_infinite():
    values = np.array([3.0, np.inf, 1.0, 2.0, np.inf, 4.0, 5.0])
    assert search._quantiles(values, 0.95) == worst_case.Quantiles(4.0, np.inf)
    assert search._quantiles(values[[0, 2, 3, 5]], 0.05) == worst_case.Quantiles(2.0, 1.0)
    assert search._quantiles(np.arange(1.0, 21.0), 0.95) == worst_case.Quantiles(10.0, 19.0)


def test_directions_are_what_the_more_sensitive_leave_of_a_parameter_and_none_of_one_that_is_known_by_them():
    rows = np.array([[1.0, 0.0, 0.0], [0.6, 0.8, 0.0], [0.6, 0.8, 5e-4], [0.0, 0.6, -0.8]])
    found = search._independent(rows, [1, 2, 3, 0], 3)
    third = rows[3] - (rows[3] @ rows[1]) * rows[1]
    assert_allclose(found[:2], [rows[1], third / np.linalg.norm(third)], atol=1e-12)
    left = rows[0] - found[:2].T @ (found[:2] @ rows[0])
    assert_allclose(found[2], left / np.linalg.norm(left), atol=1e-9)
    assert search._independent(rows, [3, 0], 1).tolist() == [rows[3].tolist()]
    assert search._independent(rows, [], 2).shape == (0, 3)


def test_a_sensitivity_is_its_largest_change_and_changes_count_either_way():
    assert worst_case.Sensitivity("a", (0.1, 0.4), 0.3).largest == 0.4
    assert worst_case.Sensitivity("a", (0.1,), 0.3).largest == 0.3
    found = worst_case.Figures(
        np.array([[2.0, 5.0], [1.0, 6.0], [3.0, 4.0]]), np.array([0.5, 0.4, 0.7]), np.array([0.9, 1.0, 2.0])
    )
    assert_allclose(search._changes(found), [[0.5, 0.2, 0.2], [0.5, 0.2, 0.4]])
    assert found.unstable == 2


@pytest.mark.parametrize(("axes", "used"), [(1, 1), (2, 2), (3, 3), (1, 2), (2, 4)])
def test_a_loop_cut_at_either_place_is_that_of_its_matrices(axes, used):
    """As many actuators as axes, or the same with a gauge of each behind the optical readings."""
    rng = np.random.default_rng(3)
    K, G = (
        rng.standard_normal((4, *shape)) + 1j * rng.standard_normal((4, *shape))
        for shape in ((axes, used), (used, axes))
    )
    for i in range(4):
        closed = np.linalg.inv(np.eye(axes) - K[i][:, axes:] @ G[i][axes:])
        optical = np.eye(axes) - G[i][:axes] @ closed @ K[i][:, :axes]
        assert_allclose(batch._at_optical(K, G, axes)[i], optical, rtol=1e-10)
        assert_allclose(batch._at_commands(K, G, axes)[i], np.eye(axes) - K[i] @ G[i], rtol=1e-12)
        least = np.min(np.linalg.svd(optical)[1]) ** 2
        assert_allclose(batch._least_squares(batch._at_optical(K, G, axes))[i], least, rtol=1e-9)


def test_light_poles_are_told_by_loop_with_frequency_and_half_width():
    period = 2e-4
    s = 2 * np.pi * np.array([[-3.0 + 400j, -90.0 + 400j, -1.0 + 2498j], [-5.0 - 40j, -7.9 + 40j, -0.0 + 150j]])
    row, freq, half = batch._light(np.exp(s * period), period)
    assert row.tolist() == [0, 1, 1]
    assert_allclose(freq, [400.0, 40.0, 150.0], rtol=1e-9)
    assert_allclose(half, [3.0, 7.9, 1e-9 / period], rtol=1e-6)
    grid = np.array([1.0, 100.0, 395.0, 399.0, 402.0, 900.0])
    assert batch._seen_by(grid, (row, freq, np.array([1.5, 190.0, 400.0]))).tolist() == [False, False, True]


@pytest.mark.parametrize(
    ("middle", "last", "said"),
    [(1.0, 0.89, "settles"), (1.0, 0.91, "grows"), (1e-3, 0.0199, "settles"), (1e-3, 0.0201, "grows")],
)
def test_the_last_third_of_the_larger_axis_is_held_against_the_middle_one_and_the_offset(middle, last, said):
    error = np.full((10, 2), 5.0)
    error[3:7], error[7:] = 0.0, 0.0
    error[5, 1], error[8, 0], error[9, 1] = -middle, -last, 0.3 * last
    assert in_time.course(error, 2.0) == said


class Known:
    """Three parameters with two numbers behind them; a number below -2.5 of the second is no mirror."""

    parameters = ("gain", "pole", "zero")
    rows = np.array([[1.0, 0.0], [0.6, 0.8], [0.0, 1.0]])

    def moved(self, normals):
        return None if normals[1] < -2.5 else search.Moved(tuple(normals.tolist()), self.rows @ normals)

    def drawn(self, count, seed):
        each = 1.5 * np.random.default_rng(seed).standard_normal((count, 2))
        return [search.Moved(tuple(normals.tolist()), self.rows @ normals) for normals in each]


def known_subject(asked):
    """Rms of two indices, modulus and pole by the two numbers; unstable where the first is beyond 2.2."""

    def figures(mirrors, indices, threads):
        asked.append((len(mirrors), [i.kind for i in indices], threads))
        a, b = np.array([m.mirror for m in mirrors]).reshape(-1, 2).T
        wild = a > 2.2
        rms = np.column_stack([np.where(wild, np.inf, 5.0 + 0.5 * a + 0.1 * b), np.where(wild, np.inf, 2.0 - 0.3 * b)])
        return worst_case.Figures(
            rms, np.where(wild, 0.0, 0.5 - 0.05 * a - 0.02 * b), np.where(wild, 1.0 + 0.1 * a, 0.9)
        )

    simulated = SimpleNamespace(on=lambda mirror, pole: ("in time", mirror, round(pole, 9)))
    return SimpleNamespace(
        known=Known(), theory="theory", controller=SimpleNamespace(name="PI"), figures=figures, simulated=simulated
    )


def test_the_worst_case_is_the_worst_of_own_draws_and_corners_each_with_where_it_is(monkeypatch):
    asked, said = [], []
    monkeypatch.setattr(search, "close", lambda theory, controller: (theory, controller.name))
    monkeypatch.setattr(search, "refuse_unstable", said.append)
    subject, indices = known_subject(asked), (APE, ErrorIndex("RPE", 0.1))
    extent = Extent(draws=9, most_sensitive=2, sigmas=3.0)
    found = worst_case.worst_case(subject, 4, indices, extent, 3, lambda *each: said.append(each))
    assert said == [
        ("theory", "PI"), (0, 4, "sensitivity of the parameters"), (1, 4, "9 mirrors drawn"), (2, 4, "corners"),
        (3, 4, "worst case in time"),
    ]  # fmt: skip
    assert asked == [(7, ["APE", "RPE"], 3), (9, ["APE", "RPE"], 3), (2, ["APE", "RPE"], 3)]
    changes = {
        "gain": ((0.1, 0.0), 0.1), "pole": ((0.076, 0.12), 0.092), "zero": ((0.02, 0.15), 0.04),
    }  # fmt: skip
    ranked = sorted(changes, key=lambda name: -max(*changes[name][0], changes[name][1]))
    assert ranked == ["zero", "pole", "gain"]
    assert [s.parameter for s in found.most_sensitive] == ranked[:2]
    for each in found.most_sensitive:
        assert (*each.rms, each.modulus) == pytest.approx((*changes[each.parameter][0], changes[each.parameter][1]))
    assert (found.corners, found.corners_left_out, found.unstable_corners) == (2, 2, 1)
    draws = 1.5 * np.random.default_rng(4).standard_normal((9, 2))
    wild = draws[:, 0] > 2.2
    assert found.unstable_draws == np.sum(wild) > 0
    assert (found.nominal_rad, found.nominal_modulus) == (pytest.approx((5.0, 2.0)), pytest.approx(0.5))
    assert [w.value for w in found.largest_rad] == [np.inf, np.inf]
    assert found.smallest_modulus.value == 0.0
    for worst in (*found.largest_rad, found.smallest_modulus):
        assert worst.sigmas == pytest.approx({"gain": 3.0, "pole": 4.2, "zero": 3.0})
    assert found.verified_in_time == ("in time", (3.0, 3.0), 1.3)
    assert (found.controller, found.extent, found.indices) == ("PI", extent, indices)
    rms = np.sort(np.where(wild, np.inf, 5.0 + 0.5 * draws[:, 0] + 0.1 * draws[:, 1]))
    assert (found.drawn_rad[0].median, found.drawn_rad[0].worse) == pytest.approx((rms[4], rms[8]))
    modulus = np.sort(np.where(wild, 0.0, 0.5 - 0.05 * draws[:, 0] - 0.02 * draws[:, 1]))
    assert (found.drawn_modulus.median, found.drawn_modulus.worse) == pytest.approx((modulus[4], modulus[0]))


def test_parameters_that_matter_to_first_order_are_told_by_slopes_along_the_numbers_behind_them(monkeypatch):
    """Of the second number the slope is that of one step up and a step of the mirror itself in place of none."""
    subject = known_subject([])
    own = subject.known.moved(np.zeros(2))
    monkeypatch.setattr(search, "CLOSELY", 2)
    slopes = np.array([[0.1, 0.0, 0.1], [0.02, 0.15, 0.04]])
    matters = np.max(np.abs(Known.rows @ slopes), axis=1)
    assert search._likely(subject, own, (APE, APE), 1) == sorted(np.argsort(-matters)[:2].tolist())
    figures, ranked = search._ranked(subject, own, (APE, APE), 1)
    assert (len(ranked), figures.modulus[0]) == (2, pytest.approx(0.5))


@pytest.mark.parametrize(
    ("pole", "samples"),
    [(0.5, 300), (1.5, 300), (0.99, round(np.log(1e3) / -np.log(0.99))), (1.002, round(np.log(1e3) / np.log(1.002))),
     (1.0, 20_000), (0.99999, 20_000), (0.0, 300)],
)  # fmt: skip
@pytest.mark.parametrize("at_rest", [True, False])
def test_a_loop_in_time_lasts_until_its_slowest_pole_has_decayed_a_thousand_times(monkeypatch, pole, samples, at_rest):
    runs, period = [], 2e-4
    loop = SimpleNamespace(timing=SimpleNamespace(period_s=period), references=[SimpleNamespace(point_ahead_rad=3e-6)])
    monkeypatch.setattr(in_time.Simulated, "_from_offset", lambda self: loop)
    monkeypatch.setattr(in_time, "rest_gain", lambda model: f"rest {model}")
    monkeypatch.setattr(in_time, "slow_gain", lambda model: f"slow {model}")
    monkeypatch.setattr(in_time, "linearised", lambda mirror, gains: (mirror.name, gains))
    monkeypatch.setattr(in_time.parts, "without", lambda loop, name: SimpleNamespace(name=name, **vars(loop)))
    monkeypatch.setattr(in_time, "replace", lambda loop, mirror: (getattr(loop, "name", "all"), mirror))
    monkeypatch.setattr(in_time, "straightened", lambda controller, loop: f"straight {controller}")
    monkeypatch.setattr(in_time, "trace", lambda *run: runs.append(run) or SimpleNamespace(error_rad=run[0][0]))
    monkeypatch.setattr(in_time, "course", lambda error, offset: (error, offset))
    mirror = SimpleNamespace(bank=("a", "b"), name="bent")
    found = in_time.Simulated(loop, "PI", at_rest).on(mirror, pole)
    kind, span = "rest" if at_rest else "slow", in_time.Span(pytest.approx(period * samples), 0.0, 0)
    assert runs == [
        (("limits", ("bent", [f"{kind} a", f"{kind} b"])), "straight PI", span), (("all", mirror), "PI", span)
    ]  # fmt: skip
    assert (found.linear, found.with_hysteresis) == (("limits", 3e-6), ("all", 3e-6))
    assert (found.pole, found.seconds, found.offset_rad) == (pole, pytest.approx(period * samples), 3e-6)
    assert found.theory == ("settles" if pole < 1.0 else "grows")


@pytest.mark.parametrize(
    ("linear", "bent", "pole", "agrees"),
    [("settles", "settles", 0.9, True), ("settles", "grows", 0.9, False), ("grows", "grows", 1.0, True),
     ("grows", "settles", 1.1, False), ("settles", "settles", 1.1, False), ("grows", "grows", 0.99, False)],
)  # fmt: skip
def test_theory_agrees_with_a_loop_in_time_where_both_runs_do_what_it_says(linear, bent, pole, agrees):
    assert in_time.InTime(pole, linear, bent, 1.0, 1e-6).agrees is agrees


@pytest.mark.parametrize(
    ("limits", "own_range", "field", "share"),
    [((-4.0, 6.0), (-9.0, 9.0), np.inf, 4.0), ((-8.0, 3.0), (-5.0, 9.0), np.inf, 3.0),
     ((-8.0, 7.0), (-5.0, 6.0), np.inf, 5.0),
     ((-8.0, 7.0), (-5.0, 2.0), np.inf, 2.0), ((-8.0, 7.0), (-5.0, 6.0), 1e-5, None)],
)  # fmt: skip
def test_an_offset_is_a_quarter_of_what_the_drives_reach_or_the_sensor_sees_without_anything_else(
    file, limits, own_range, field, share
):
    subject, _ = subject_of(file)
    loop = subject.theory
    drive = replace(loop.drive, minimum_v=limits[0], maximum_v=limits[1])
    optical = replace(loop.optical, field_of_view_rad=field)
    here = replace(loop, drive=drive, drive_range_v=own_range, optical=optical, unknown=(Misalignment(1e-6, 0.0),))
    found = replace(subject.simulated, loop=here)._from_offset()
    offset = 0.25 * (1e-5 if share is None else nominal_axis_gain(loop) * share)
    assert [r.point_ahead_rad for r in found.references] == [pytest.approx(offset, rel=1e-12)]
    assert (found.disturbances, found.unknown, found.optical.noise_rad, found.drive.drive_resolution_v) == (
        ((),),
        (),
        0,
        0,
    )
    assert (found.drive.maximum_v, found.optical.field_of_view_rad) == (limits[1], field)


def test_each_index_has_its_own_worst_mirror_and_the_weakest_is_another_one(monkeypatch):
    """Corners of two sigma: the first index grows with both numbers, the second where the second number falls."""
    monkeypatch.setattr(search, "close", lambda theory, controller: None)
    monkeypatch.setattr(search, "refuse_unstable", lambda closed: None)
    subject = known_subject([])
    weak = subject.figures
    subject.figures = lambda mirrors, indices, threads: replace(
        weak(mirrors, indices, threads),
        modulus=np.array([0.5 + 0.05 * m.mirror[0] + 0.02 * m.mirror[1] for m in mirrors]),
    )
    found = worst_case.worst_case(subject, 4, (APE, ErrorIndex("RPE", 0.1)), Extent(1, 2, 2.0))
    both, second = found.largest_rad
    assert (both.value, second.value) == (pytest.approx(6.2), pytest.approx(2.6))
    assert both.sigmas == pytest.approx({"gain": 2.0, "pole": 2.8, "zero": 2.0})
    assert second.sigmas == pytest.approx({"gain": 2.0, "pole": -0.4, "zero": -2.0})
    assert found.smallest_modulus.value == pytest.approx(0.36)
    assert found.smallest_modulus.sigmas == pytest.approx({"gain": -2.0, "pole": -2.8, "zero": -2.0})
    assert found.verified_in_time == ("in time", (-2.0, -2.0), 0.9)
    assert (found.corners, found.corners_left_out, found.unstable_corners, found.unstable_draws) == (4, 0, 0, 0)


@pytest.mark.parametrize(("states", "draws", "directions"), [(16, 1000, 10), (17, 200, 7)])
def test_without_an_extent_a_mirror_is_looked_at_as_its_states_allow(monkeypatch, states, draws, directions):
    asked, subject = [], known_subject([])
    monkeypatch.setattr(search, "close", lambda theory, controller: None)
    monkeypatch.setattr(search, "refuse_unstable", lambda closed: None)
    subject.theory = SimpleNamespace(mirror=SimpleNamespace(A=np.zeros((states, states))))
    subject.figures, figures = lambda *given: asked.append(given[1:]) or figures(*given), subject.figures
    found = worst_case.worst_case(subject, 4)
    assert found.extent == Extent(draws, directions, 3.0)
    assert asked == [((APE,), None)] * 3
    assert found.indices == (APE,)


def test_a_parameter_that_no_mirror_may_be_moved_by_has_no_sensitivity_and_those_that_may_one_way_theirs():
    class Stiff(Known):
        """No mirror has the second number beyond 0.9 either way, and none the first below 0.8 under 0."""

        def moved(self, normals):
            return None if abs(normals[1]) > 0.9 or normals[0] < -0.8 else super().moved(normals)

    asked = []
    subject = known_subject(asked)
    subject.known = Stiff()
    _, ranked = search._ranked(subject, subject.known.moved(np.zeros(2)), (APE, ErrorIndex("RPE", 0.1)), None)
    assert [s.parameter for s in ranked] == ["pole", "gain", "zero"]
    pole, gain, zero = ranked
    assert (*pole.rms, pole.modulus) == pytest.approx((0.076, 0.12, 0.092))
    assert (*gain.rms, gain.modulus) == pytest.approx((0.1, 0.0, 0.1))
    assert (zero.rms, zero.modulus, zero.largest) == ((0.0, 0.0), 0.0, 0.0)
    assert asked == [(4, ["APE", "RPE"], None)]


def test_many_mirrors_are_worked_on_in_parts_by_the_threads_that_are_asked_for_and_stand_in_their_order(monkeypatch):
    asked = []

    def together(loop, controller, margins, part, indices):
        assert (loop, controller, margins, indices) == (
            "loop",
            "straight PI",
            ("margins", "loop", "straight PI"),
            (APE,),
        )
        return worst_case.Figures(np.array(part)[:, None] * 1.0, np.array(part) + 0.25, np.array(part) + 0.5)

    def in_threads(jobs, workers):
        asked.append((len(jobs), workers))
        return [job() for job in jobs]

    monkeypatch.setattr(batch, "straightened", lambda controller, loop: f"straight {controller}")
    monkeypatch.setattr(batch, "Margins", lambda *given: ("margins", *given))
    monkeypatch.setattr(batch, "_together", together)
    monkeypatch.setattr(batch, "in_threads", in_threads)
    monkeypatch.setattr(batch, "AT_ONCE", 3)
    found = batch.figures("loop", "PI", (7, 5, 6, 2, 4), (APE,), 6)
    assert asked == [(2, 6)]
    assert found.rms_rad.tolist() == [[7.0], [5.0], [6.0], [2.0], [4.0]]
    assert (found.modulus - 0.25).tolist() == (found.pole - 0.5).tolist() == [7.0, 5.0, 6.0, 2.0, 4.0]
    assert batch.figures("loop", "PI", (0, -1, 0.5), (APE,)).unstable == 1
    assert asked[1] == (1, None)


def test_a_parameter_without_a_standard_error_is_not_moved(tmp_path):
    known = worst_case.of_table(table_of(tmp_path, (0.02, 0.0, 0.1)).mission.mirror)
    assert np.isfinite(known.rows).all()
    assert not known.rows[1].any()
    drawn = known.drawn(5, 3)
    assert len(drawn) == 5
    for each in (*drawn, *(known.moved(sign * row) for row in np.eye(known.rows.shape[1]) for sign in (1.0, -1.0))):
        assert np.isfinite(each.sigmas).all()
        assert each.sigmas[1] == 0.0


def test_a_subject_is_an_axis_that_stands_for_all_or_all_axes_about_rest(monkeypatch):
    monkeypatch.setattr(search, "on_one_axis", lambda design, scene: (design.controller, scene.axis))
    axis = SimpleNamespace(controller="PI")
    scene = SimpleNamespace(axis="x alone", loop=SimpleNamespace(axes=3), rest="at rest")
    one, whole = worst_case.of_scene(scene, "known", axis), worst_case.of_coupled_scene(scene, "known", axis)
    assert (one.theory, one.alike, one.known, one.controller) == ("x alone", 3, "known", ("PI", "x alone"))
    assert (one.simulated.loop, one.simulated.at_rest) == ("x alone", False)
    assert (whole.theory, whole.alike, whole.known, whole.controller) == ("at rest", 1, "known", "PI")
    assert (whole.simulated.loop, whole.simulated.at_rest) == (scene.loop, True)


@pytest.mark.parametrize(("alike", "at_rest", "gain"), [(4, False, 1.75), (1, True, 1.0)])
def test_figures_of_mirrors_are_of_their_elements_gains_at_rest_or_of_slow_motion_for_so_many_axes(
    monkeypatch, alike, at_rest, gain
):
    """Plays of 1 at threshold 0 and 0.75 beyond it: at rest the first alone."""
    asked = []

    def figures(*given):
        asked.append(given)
        return worst_case.Figures(np.array([[3.0, 5.0]]), np.array([0.5]), np.array([0.9]))

    monkeypatch.setattr(search, "figures", figures)
    plays = PrandtlIshlinskii((0.0, 1.0), (1.0, 0.75))
    mirrors = [search.Moved(SimpleNamespace(bank=bank, linear=tuple), None) for bank in ((plays, plays), ())]
    subject = Subject("theory", alike, Simulated("loop", "PI", at_rest), None)
    found = subject.figures(mirrors, (APE,), 5)
    assert asked == [("theory", "PI", [(gain, gain), ()], (APE,), 5)]
    assert found.rms_rad.tolist() == [[3.0 * alike**0.5, 5.0 * alike**0.5]]
    assert (found.modulus.tolist(), found.pole.tolist()) == ([0.5], [0.9])


def test_a_value_below_nothing_is_moved_up_and_down_in_its_own_standard_errors(tmp_path):
    """Of a gain above 0 and a weight below 0 that go along with each other by half."""
    errors = {"bouc_wen.d1": ("d1_rad_v", 0.02), "bouc_wen.epsilon": ("epsilon_rad_v", 0.05)}
    names = str(list(errors)).replace("'", '"')
    text = f"{MIRROR}\n[uncertainty]\nparameters = {names}\nstandard_errors = [0.02, 0.05]\ncorrelation = [0.5]\n"
    (tmp_path / "mirror.toml").write_text(text, encoding="utf-8")
    table = load_loop(DEFAULT, tmp_path / "mirror.toml")[0].mission.mirror
    known = worst_case.of_table(table)
    assert_allclose(known.rows @ known.rows.T, [[1.0, 0.5], [0.5, 1.0]], rtol=1e-9)
    own = from_table(table).inverse[0]
    assert own.epsilon_rad_v < 0.0 < own.d1_rad_v
    normals = [np.array(each) for each in ((1.0, 0.0), (0.0, 1.0), (-0.7, 2.0))]
    for each in (*known.drawn(3, 8), *map(known.moved, normals)):
        there = each.mirror.inverse[0]
        off = [
            (getattr(there, name) - getattr(own, name)) / (error * abs(getattr(own, name)))
            for name, error in errors.values()
        ]
        assert_allclose(each.sigmas, off, rtol=1e-6, atol=1e-9)
    for each in normals:
        assert_allclose(known.moved(each).sigmas, known.rows @ each, rtol=1e-9, atol=1e-12)


def test_a_parameter_whose_error_makes_a_loop_unstable_matters_more_than_any(monkeypatch):
    rows = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])

    def moved(normals):
        return search.Moved(tuple(normals.tolist()), rows @ normals)

    def figures(mirrors, indices, threads):
        a, b, c = np.array([each.mirror for each in mirrors]).T
        wild = b > 0.5
        return worst_case.Figures(
            np.where(wild, np.inf, 5.0 + 3.0 * a + 0.1 * c)[:, None], np.where(wild, 0.0, 0.5 + 0.01 * c), 1.0 + 0.1 * b
        )

    known = SimpleNamespace(parameters=("gain", "pole", "zero"), rows=rows, moved=moved)
    subject = SimpleNamespace(known=known, figures=figures)
    for most, expected in ((1, [1]), (2, [0, 1])):
        monkeypatch.setattr(search, "CLOSELY", most)
        assert search._likely(subject, moved(np.zeros(3)), (APE,), 1) == expected


@pytest.mark.parametrize(
    ("used", "cuts", "readings"),
    [((0,), ["_at_optical"], 1), ((1,), ["_at_commands"], 2), ((0, 1), ["_at_optical", "_at_commands"], 2),
     ((0, 2), ["_at_optical"], 1), ((0, 1, 2), ["_at_optical", "_at_commands"], 2)],
)  # fmt: skip
@pytest.mark.parametrize("through", ["B", "D"])
def test_a_loop_is_cut_at_the_sensors_that_its_controller_looks_at_and_not_at_its_reference(
    used, cuts, readings, through
):
    """Inputs: optical error, gauge, reference; into the states alone or straight to the command."""
    loop = loop_of()
    B, D = np.zeros((1, 3)), np.zeros((1, 3))
    (B if through == "B" else D)[0, list(used)] = 2.0
    one = lti.StateSpace(np.array([[0.5]]), B, np.ones((1, 1)), D)
    margins = batch.Margins(loop, LoopController("own", one, np.zeros((1, 1))))
    assert [cut.__name__ for cut in margins._cuts] == cuts
    assert margins._answers.shape[1:] == (1, readings)


def test_parameters_that_make_no_mirror_of_several_axes_have_none():
    """Plays as heavy as that take more than the whole stiffness away where they slide: the mirror would grow."""
    known = worst_case.of_several_axes(several_axes.two_axes())
    heavier = np.array([0.0, 0.0, 1.0, 0.0])
    assert known.moved(100.0 * heavier) is not None
    assert known.moved(1000.0 * heavier) is None
