"""The search for gains with which the paper's closed-loop claims hold, against single runs of the loop."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from microrad.loop import control
from microrad.loop import sine_run as simulate
from microrad.mirror import hysteresis
from microrad.mirror import model as mirror
from microrad.mission.file import load_mission
from microrad.study import paper
from scenes import cases_of
from shipped import SHIPPED, edited, whole_study

ACCURATE = "PID + inverse stays within 10 µrad at its peaks"


@pytest.fixture(scope="module")
def mission():
    return load_mission(SHIPPED).mission


@pytest.fixture(scope="module")
def scanned():
    """The scan of the shipped mission in its study, and what it said of its progress."""
    found, said = whole_study()
    return found.scan, [message for message in said if message[2] == "scan of gains and compositions"]


def at(scan, composition, integral, proportional=1e3):
    (point,) = [
        p
        for p in scan.points
        if (p.composition, p.proportional_v_rad, p.integral_v_rad_s) == (composition, proportional, integral)
    ]
    return point


def test_the_scan_covers_its_grid_and_tells_its_progress(scanned):
    scan, said = scanned
    assert len({(p.composition, p.proportional_v_rad, p.integral_v_rad_s) for p in scan.points}) == 60
    assert [message[:2] for message in said] == [(done, 60) for done in range(1, 61)]
    assert all(p.stable for p in scan.points)


def test_four_claims_hold_in_a_region_and_all_five_nowhere(scanned):
    scan, _ = scanned
    names, points = scan.together()
    assert names == tuple(n for n in paper.CLAIMS if n != ACCURATE)
    assert max(sum(p.holds().values()) for p in scan.points) == 4
    assert scan.holding(tuple(paper.CLAIMS)) == ()
    cascade = {(p.proportional_v_rad, p.integral_v_rad_s) for p in points if p.composition == "cascade"}
    assert cascade == {(kp, ki) for kp in (0.0, 1e3, 4e3) for ki in (14e6, 15e6, 16e6)}
    assert not at(scan, "cascade", 13e6).holds()["the inverse takes 10 µrad ± 25 % off the peak at 15 Hz"]
    assert not at(scan, "cascade", 18e6).holds()["the inverse takes 25 µrad ± 25 % off the peak at 25 Hz"]
    assert {p.composition for p in points} == {"cascade", "additive"}


@pytest.mark.parametrize(
    ("composition", "proportional", "integral"),
    [("cascade", 1e3, 16e6), ("cascade", 0.0, 14e6), ("additive", 4e3, 13e6), ("cascade", 4e3, 40e6)],
)
def test_points_of_the_scan_against_runs_with_the_fine_step(mission, scanned, composition, proportional, integral):
    """The coarse step of the scan moves its errors by less than 2 %, and no claim."""
    point = at(scanned[0], composition, integral, proportional)
    timing = control.timing_from_mission(mission.control)
    assert timing.steps_per_sample == 2
    pid = control.pid(control.Gains(proportional, integral, 0.0, 1e-4), timing.period_s)
    setup = simulate.Setup(control.drive_from_mission(mission), timing, pid)
    model = cases_of(mission).mirrors.line_of_sight["given"].model
    hysteretic = mirror.from_mission(mission.mirror, model, composition)
    straight = mirror.from_mission(mission.mirror, hysteresis.gain_only(model), composition)

    def run(m, freq_hz, inverse=control.no_feedforward):
        return simulate.track_sine("", m, setup, inverse(m), 300e-6, freq_hz)

    pid_runs = {f: run(hysteretic, f) for f in (1.0, 15.0, 25.0)}
    straight_runs = {f: run(straight, f) for f in (1.0, 15.0)}
    fine = replace(
        point,
        linear_rms={f: t.rms_rad for f, t in straight_runs.items()},
        added_rms={
            f: float(np.sqrt(np.mean((pid_runs[f].error_rad - t.error_rad)[t.steady] ** 2)))
            for f, t in straight_runs.items()
        },
        pid_rms={f: t.rms_rad for f, t in pid_runs.items()},
        pid_peak={f: t.peak_rad for f, t in pid_runs.items()},
        inverse_peak={f: run(hysteretic, f, control.inverse).peak_rad for f in (15.0, 25.0)},
    )
    for name in ("linear_rms", "pid_rms", "pid_peak", "inverse_peak", "added_rms"):
        found, expected = getattr(point, name), getattr(fine, name)
        assert found.keys() == expected.keys()
        assert_allclose(list(found.values()), list(expected.values()), rtol=0.02, err_msg=name)
    assert point.holds() == fine.holds()


def test_an_unstable_point_holds_no_claim(monkeypatch, mission):
    monkeypatch.setattr(paper, "PROPORTIONAL_V_MRAD", (1.0,))
    monkeypatch.setattr(paper, "INTEGRAL_V_MRAD_S", (16e3, 50 * 16e3))
    monkeypatch.setattr(paper, "COMPOSITIONS", ("cascade",))
    stable, unstable = paper.scan(cases_of(mission)).points
    assert (stable.stable, unstable.stable) == (True, False)
    assert sum(stable.holds().values()) == 4
    assert not any(unstable.holds().values())
    assert unstable.pid_peak == {}


def point(**errors):
    """A point at which the first four claims hold, with other errors where given (rad)."""
    usual = {
        "linear_rms": {1.0: 0.9e-6, 15.0: 14e-6},
        "added_rms": {1.0: 0.4e-6, 15.0: 1.7e-6},
        "pid_rms": {1.0: 1.0e-6, 15.0: 14.4e-6},
        "pid_peak": {15.0: 20e-6, 25.0: 35e-6},
        "inverse_peak": {15.0: 10.0e-6, 25.0: 10.5e-6},
    }
    return paper.Point("cascade", 1e3, 16e6, True, **{**usual, **errors})


@pytest.mark.parametrize(
    ("errors", "held"),
    [
        ({}, "++++-"),
        ({"inverse_peak": {15.0: 9.9e-6, 25.0: 9.9e-6}}, "+++++"),
        ({"inverse_peak": {15.0: 10e-6, 25.0: 10e-6}}, "+++++"),
        ({"inverse_peak": {15.0: 10.1e-6, 25.0: 9.9e-6}}, "++++-"),
        ({"pid_rms": {1.0: 0.905e-6, 15.0: 14.4e-6}}, "-+++-"),
        ({"pid_rms": {1.0: 1.0e-6, 15.0: 14.1e-6}}, "-+++-"),
        ({"added_rms": {1.0: 1.7e-6, 15.0: 1.7e-6}}, "+-++-"),
        ({"added_rms": {1.0: 1.8e-6, 15.0: 1.7e-6}}, "+-++-"),
        ({"pid_peak": {15.0: 22.4e-6, 25.0: 35e-6}}, "++++-"),
        ({"pid_peak": {15.0: 22.6e-6, 25.0: 35e-6}}, "++-+-"),
        ({"pid_peak": {15.0: 17.4e-6, 25.0: 35e-6}}, "++-+-"),
        ({"pid_peak": {15.0: 20e-6, 25.0: 29.2e-6}}, "+++--"),
        ({"pid_peak": {15.0: 20e-6, 25.0: 41.8e-6}}, "+++--"),
    ],
)
def test_claims_by_hand(errors, held):
    assert "".join("+" if ok else "-" for ok in point(**errors).holds().values()) == held


def test_together_names_the_largest_set():
    best, other = point(), point(added_rms={1.0: 1.8e-6, 15.0: 1.7e-6})
    names, points = paper.Scan((other, best, other)).together()
    assert names == tuple(paper.CLAIMS)[:4]
    assert points == (best,)
    nothing = replace(best, stable=False)
    assert paper.Scan((nothing, nothing)).together() == ((), ())


def test_the_scan_applies_to_a_linear_part_with_bouc_wen(tmp_path, mission):
    assert paper.applies(mission.mirror)
    assert not paper.applies(mission.mirror.model_copy(update={"bouc_wen": None}))
    text = SHIPPED.read_text()
    linear = text[text.index("[mirror.linear]") : text.index("[mirror.bouc_wen]")]
    assert not paper.applies(
        edited(tmp_path, (linear, ""), ('composition = "cascade"', 'composition = "static"')).mirror
    )


def test_the_scan_keeps_its_loop_gain_on_a_mirror_of_another_gain(monkeypatch, tmp_path, mission):
    monkeypatch.setattr(paper, "PROPORTIONAL_V_MRAD", (1.0,))
    monkeypatch.setattr(paper, "INTEGRAL_V_MRAD_S", (16e3,))
    monkeypatch.setattr(paper, "COMPOSITIONS", ("cascade",))
    doubled = edited(tmp_path, ('mirror_angle = "line-of-sight"', 'mirror_angle = "mechanical"'))
    (usual,), (other,) = paper.scan(cases_of(mission)).points, paper.scan(cases_of(doubled)).points
    assert_allclose(other.linear_rms[15.0], usual.linear_rms[15.0], rtol=1e-3)


POINT = paper.Point(
    "cascade", 1e3, 2e6, True, {1.0: 2.0, 15.0: 4.0}, {1.0: 0.5, 15.0: 0.75}, {1.0: 2.03, 15.0: 4.1},
    {15.0: 19e-6, 25.0: 34e-6}, {15.0: 6.6e-6, 25.0: 9.9e-6},
)  # fmt: skip


@pytest.mark.parametrize(("found", "expected"), [
    (lambda: POINT.holds().values(), "1 1 1 1 1"),
    (lambda: replace(POINT, stable=False).holds().values(), "0 0 0 0 0"),
    (lambda: replace(POINT, pid_rms={1.0: 2.02, 15.0: 4.1}).holds().values(), "0 1 1 1 1"),
    (lambda: replace(POINT, added_rms={1.0: 2.0, 15.0: 2.0}).holds().values(), "1 0 1 1 1"),
    (lambda: replace(POINT, inverse_peak={15.0: 9e-6, 25.0: 10.5e-6}).holds().values(), "1 1 1 1 0"),
    (lambda: [POINT.drop_rad(15.0), POINT.drop_rad(25.0)], "1.24e-05 2.41e-05"),
    (lambda: [len(x) for x in paper.Scan((POINT, replace(POINT, stable=False))).together()], "5 1"),
])  # fmt: skip
def test_a_point_of_the_scan_holds_claims_up_to_their_limits(found, expected):
    assert list(found()) == pytest.approx([float(each) for each in expected.split()], rel=1e-6, abs=0.0, nan_ok=True)


@pytest.mark.parametrize(
    ("own", "steps", "delay", "wanted"), [("cascade", 7, 2, 1), ("additive", 6, 14, 3), ("additive", 3, 0, 0)]
)
def test_each_point_of_a_scan_has_its_composition_and_its_gains_at_whole_periods_of_delay(
    monkeypatch, own, steps, delay, wanted
):
    """A delay that is no whole number of periods is longer, and a plant of the mission's own composition is taken."""
    monkeypatch.setattr(paper, "PROPORTIONAL_V_MRAD", (0.0, 4.0))
    monkeypatch.setattr(paper, "INTEGRAL_V_MRAD_S", (5.0, 3.0, 9.0))
    monkeypatch.setattr(paper, "_point", lambda *given: given)
    monkeypatch.setattr(paper.mirror, "from_mission", lambda *given: given)
    sight = {
        v: SimpleNamespace(plant=f"own {v}", model=f"model {v}") for v in (paper.Variant.GIVEN, paper.Variant.STRAIGHT)
    }
    table = SimpleNamespace(composition=own)
    mirrors = SimpleNamespace(table=table, line_of_sight=sight, line_of_sight_per_own=2.0)
    timing = control.Timing(7e-4, steps, delay)
    cases = SimpleNamespace(setup=SimpleNamespace(timing=timing), mirrors=mirrors)

    def plant(variant, composition):
        return f"own {variant}" if composition == own else (table, f"model {variant}", composition, 2.0)

    coarse = control.Timing(7e-4, 1, wanted)
    assert paper.scan(cases).points == tuple(
        (cases, coarse, plant("no hysteresis", "cascade"), plant("given", composition), composition, kp, ki)
        for composition in ("cascade", "additive")
        for kp in (0.0, 4.0)
        for ki in (5.0, 3.0, 9.0)
    )


def test_of_sets_of_claims_of_one_size_the_first_counts_with_all_points_that_hold_it():
    few, first, other = (
        point(added_rms={1.0: 1.8e-6, 15.0: 1.7e-6}, pid_peak={15.0: 22.6e-6, 25.0: 35e-6}),
        point(pid_peak={15.0: 20e-6, 25.0: 29e-6}),
        point(pid_peak={15.0: 22.6e-6, 25.0: 35e-6}),
    )
    again, more = replace(first, integral_v_rad_s=9e6), point()
    claims = tuple(paper.CLAIMS)
    names, points = paper.Scan((few, first, other, again)).together()
    assert (names, points) == (claims[:3], (first, again))
    names, points = paper.Scan((few, other, first)).together()
    assert (names, points) == ((*claims[:2], claims[3]), (other,))
    assert paper.Scan((few, first, other, again, more)).together() == (claims[:4], (more,))
    assert paper.Scan((few, first, other)).holding(claims[3:4]) == (few, other)
