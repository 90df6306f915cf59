"""One contact in the time domain: its order, the fine loop in its windows, loss of lock, and what is refused."""

import math
import re
from dataclasses import astuple, replace
from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import budgets
from made_tables import one_line
from microrad import link
from microrad.core import kernels
from microrad.core.units import format_quantity
from microrad.link import study as link_study
from microrad.link.acquisition import sequence as acquisition
from microrad.loop import control, controller_study
from microrad.loop.controller_study import designs
from microrad.loop.disturbance import Reference
from microrad.loop.pointing_loop import ensemble, traces
from microrad.loop.pointing_loop.loop import assemble
from microrad.mission.file import LinkFile, load_mission
from microrad.study.contact_run import sequence
from microrad.study.contact_run import windows as drawn_windows
from microrad.study.contact_run.records import STATES, Contact, ContactRun, Loss, Settings, Sight, State, Transition
from microrad.study.contact_run.windows import MovingReference, Sampler, first_run, plan
from scenes import scene_of
from shipped import SHIPPED, edited_file

C_M_S = 299_792_458.0
LEO_M, GEO_M, EARTH_M, MU = 6_878_137.0, 42_164_170.0, 6_378_137.0, 3.986004418e14
LIMB = "the Earth's limb"
STRONG, HARD = (800, 10), (1000, 30)  # takes the lock from some windows; from every one
FIRST = ["slew", "beacon", "detect", "answer", "lock", "data"]
SHAKEN = 'spectrum = "first-order"\nlevel = "{} urad^2/Hz"\ncorner = "{} Hz"'


def coplanar(time_s):
    """The line of sight of two circular orbits in one plane, aligned at time 0."""
    radius = np.array([LEO_M, GEO_M])
    turn = np.sqrt(MU / radius**3)
    angle = turn[:, None] * time_s
    place = radius[:, None] * np.array([np.cos(angle), np.sin(angle)])
    speed = (radius * turn)[:, None] * np.array([-np.sin(angle), np.cos(angle)])
    between, moving = place[:, 1] - place[:, 0], speed[:, 1] - speed[:, 0]
    range_m = np.hypot(*between)
    rate = np.abs(between[0] * moving[1] - between[1] * moving[0]) / range_m**2
    return Sight(range_m, rate, 2.0 * rate * range_m / C_M_S)


HALF_S = (math.acos(EARTH_M / LEO_M) + math.acos(EARTH_M / GEO_M)) / (
    math.sqrt(MU / LEO_M**3) - math.sqrt(MU / GEO_M**3)
)


def steady(range_m=42e6, rate_rad_s=100e-6, point_ahead_rad=30e-6):
    """A line of sight that does not change."""
    return lambda time_s: Sight(*(np.full(np.shape(time_s), v) for v in (range_m, rate_rad_s, point_ahead_rad)))


def contact(start_s=1000.0, length_s=600.0, geometry=None, free_from_s=0.0):
    return Contact(start_s, start_s + length_s, LIMB, "eclipse of LEO", free_from_s, geometry or steady())


def settings(**changes):
    given = {"slew_angle_rad": 1.0, "slew_rate_rad_s": 0.01, "windows": 3, "window_s": 0.4, "settle_s": 0.2}
    return Settings(**{**given, "hold_s": 0.01, "seed": 1, "attempts": 5, **changes})


def links(file):
    """Few acquisitions are drawn, and no tornados: a contact has an acquisition of its own."""
    few = file.mission.acquisition.model_copy(update={"runs": 100})
    m = file.mission.model_copy(update={"acquisition": few})
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(link_study, "tornados", lambda *args: ())
        return link_study.run_link_study(LinkFile(m, file.path, file.text, file.sha256, file.sources))


@pytest.fixture(scope="module")
def file():
    return load_mission(SHIPPED)


@pytest.fixture(scope="module")
def scene(file):
    return scene_of(file)


@pytest.fixture(scope="module")
def design(file, scene):
    """The PI controller of the grid, for the nominal mirror alone: made in half a second."""
    tuned = designs.grid_baseline(designs.plants(scene, 1)[:1], control.Specification(0.5))
    return controller_study.Design("PI", tuned, assemble("PI", scene.loop, tuned.controller))


@pytest.fixture(scope="module")
def finding(file):
    return links(file).finding


@pytest.fixture(scope="module")
def run(file, scene, design, finding):
    """A contact of the shipped mission, or of another scene or way to find the partner."""

    def made(of, how, *, scene=scene, finding=finding, mission=file.mission):
        return sequence.run_contact(link.of(mission), finding, scene, design, of, how)

    return made


@pytest.fixture(scope="module")
def shaken(tmp_path_factory):
    """The mission's scene under a strong vibration, by its level (µrad²/Hz) and corner (Hz)."""

    def made(level, corner_hz):
        text = SHAKEN.format(level, corner_hz)
        folder = tmp_path_factory.mktemp("shaken")
        return scene_of(edited_file(folder, ('\nspectrum = "olympus"', "\n" + text), whole=True))

    return made


@pytest.fixture
def sampler(file, scene, design):
    def made(of=None, how=None, mission=None, scene=scene):
        m = mission or file.mission
        return Sampler(link.of(m), m.fine_pointing, scene.loop, design.controller, of or contact(), how or settings())

    return made


@pytest.fixture(scope="module")
def whole(run):
    """A whole contact between two orbits in one plane."""
    of = Contact(-HALF_S, HALF_S, LIMB, LIMB, -HALF_S - 1000.0, coplanar)
    return run(of, settings(windows=8, window_s=1.0))


def route(log):
    """The states in their order, the first one left out; failures and stages within one state once."""
    to = [entry.to for entry in log]
    return [state for i, state in enumerate(to) if i == 0 or state != to[i - 1]]


def check_order(found):
    """Each transition leaves the state that the one before has led to, in the order of time, and says why."""
    assert found.log[0].state == "idle"
    for before, after in pairwise(found.log):
        assert before.to == after.state
        assert before.time_s <= after.time_s
    assert [entry.to for entry in found.log].count("end") == 1
    assert found.log[-1].to == "end"
    assert all(entry.cause for entry in found.log)
    ends = found.log[-1].time_s - found.log[0].time_s
    assert sum(found.seconds.values()) == pytest.approx(ends, abs=1e-9)
    assert tuple(found.seconds) == STATES


# ------------------------------------------------------------------------------------------------- a whole contact
@pytest.mark.promise("readme-8")
@pytest.mark.promise("day-26", "day-28", "day-29")
def test_a_contact_goes_from_the_slew_to_data_and_ends_with_its_cause(whole, finding):
    check_order(whole)
    assert route(whole.log) == [*FIRST, "end"]
    assert whole.log[0].time_s == pytest.approx(-HALF_S - 100.0)
    assert whole.log[0].cause == "1 rad at 10 mrad/s, so that the slew ends when the contact begins"
    assert (whole.log[1].time_s, whole.log[1].cause) == (pytest.approx(-HALF_S), f"the contact begins: {LIMB}")
    assert (whole.log[-1].time_s, whole.log[-1].cause) == (pytest.approx(HALF_S), f"the contact ends: {LIMB}")
    assert [entry.cause for entry in whole.log[2:-1]] == [
        "beacon travels: done",
        "GEO detects: done",
        "LEO detects the answer: done",
        "LEO locks: done",
    ]
    assert whole.first_data_s == pytest.approx(-HALF_S + finding.wide.log[-1].time_s)  # the same seed
    assert whole.data_s == pytest.approx(HALF_S - whole.first_data_s)
    assert whole.data_share == pytest.approx(whole.data_s / (2 * HALF_S))
    assert (whole.losses, whole.losses_per_s, whole.share_below) == (0, 0.0, 0.0)
    assert whole.bits(300e6) == pytest.approx(300e6 * whole.data_s)
    assert 58.1 < 2 * HALF_S / 60 < 58.2  # minutes


@pytest.mark.promise("day-26")
def test_windows_spread_from_lock_to_the_end_over_the_geometry_of_their_moment(whole):
    begins = np.array([w.start_s for w in whole.windows])
    assert_allclose(begins, np.linspace(whole.first_data_s, HALF_S - 1.0, 8), rtol=0, atol=1e-9)
    at = coplanar(begins)
    assert_allclose([w.range_m for w in whole.windows], at.range_m, rtol=1e-12)
    assert_allclose([w.rate_rad_s for w in whole.windows], at.rate_rad_s, rtol=1e-9)
    assert_allclose([w.point_ahead_rad for w in whole.windows], at.point_ahead_rad, rtol=1e-9)
    for w in whole.windows:
        assert (w.seconds, w.loss, w.radial_rad.size) == (pytest.approx(1.0), None, 5000)
        assert_allclose(w.time_s, w.start_s + 2e-4 * np.arange(5000), rtol=0, atol=1e-9)
        assert w.rms_rad == pytest.approx(math.sqrt(np.mean(w.radial_rad**2)))
        assert w.quantile_rad == pytest.approx(np.quantile(w.radial_rad, 0.997))
        assert w.largest_rad == np.max(w.radial_rad) > w.quantile_rad > w.rms_rad
        assert w.lowest_margin_db == np.min(w.margin_db)
    assert whole.sampled_s == pytest.approx(8.0)


@pytest.mark.promise("day-30")
def test_the_margin_follows_the_range_and_the_error(whole, file):
    """The budget at the range of a sample and at its error."""
    for w in (whole.windows[0], whole.windows[4]):
        for k in (0, 1234, 4999):
            beam = file.mission.communication.model_copy(
                update={"distance_m": float(coplanar(w.time_s[k : k + 1]).range_m[0])}
            )
            there = file.mission.model_copy(update={"communication": beam})
            budget = budgets.communication(there, file.sources, pointing_error_rad=float(w.radial_rad[k]))
            assert w.margin_db[k] == pytest.approx(budget.margin_db, abs=1e-6)


def test_the_margin_of_a_window_that_is_cut_short_follows_the_range_of_its_own_time(sampler, file):
    of = Contact(-HALF_S, HALF_S, LIMB, LIMB, -HALF_S - 1000.0, coplanar)
    found = sampler(of, settings(windows=1, window_s=1.0)).window(0, -HALF_S / 2, 0.4)
    assert found.seconds == pytest.approx(0.4)
    for k in (0, 999, 1999):
        distance_m = float(coplanar(found.time_s[k : k + 1]).range_m[0])
        beam = file.mission.communication.model_copy(update={"distance_m": distance_m})
        there = file.mission.model_copy(update={"communication": beam})
        budget = budgets.communication(there, file.sources, pointing_error_rad=float(found.radial_rad[k]))
        assert found.margin_db[k] == pytest.approx(budget.margin_db, abs=1e-6)


@pytest.mark.promise("day-30")
def test_the_residual_of_a_window_is_the_ensembles_with_the_same_references(file, scene, design, sampler):
    """To the last bit that of the run of its number, and about the rms of 64 runs."""
    how = settings(window_s=1.0, settle_s=0.3, seed=7)
    windows = [sampler(how=how).window(number, 1000.0, 1.0) for number in range(4)]
    lag = 0.01 * 100e-6 / (2 * math.pi * 0.1)
    loop = replace(scene.loop, references=(Reference(30e-6 + lag, 0.0, 0.1), scene.loop.references[1]))
    span = ensemble.Span(1.3, 0.3, 7)
    for number in (0, 3):
        error = traces.trace(loop, design.controller, span, number).error_rad[1500:]
        assert_allclose(windows[number].radial_rad, np.hypot(error[:, 0], error[:, 1]), rtol=1e-9, atol=1e-15)
    together = ensemble.simulate(loop, design.controller, span, 64)
    single = np.sqrt(np.sum(together.rms_rad**2, axis=1))[:4]
    assert_allclose([w.rms_rad for w in windows], single, rtol=0.02)  # control samples against plant steps
    mean = math.sqrt(np.mean([w.rms_rad**2 for w in windows]))
    assert mean == pytest.approx(together.radial_rms_rad, rel=0.05)


# ------------------------------------------------------------------------------------------------------ references
@pytest.mark.promise("day-30")
def test_a_moving_reference_is_what_a_first_order_body_leaves_of_a_changing_rate():
    """Euler's steps of e' = rate(t) - w e, from long before."""
    moving = MovingReference(30e-6, 2e-6, 0.1, point_ahead_rate_rad_s=-0.5e-6, acceleration_rad_s2=0.3e-6)
    w, step = 2 * math.pi * 0.1, 5e-4
    error, found = 0.0, {}
    for t in np.arange(-20.0, 3.0, step):
        found[round(t, 4)] = error
        error += step * (2e-6 + 0.3e-6 * t - w * error)
    for t in (0.0, 1.0, 2.9):
        assert moving.at(np.array([t]))[0] == pytest.approx(30e-6 - 0.5e-6 * t + found[t], abs=2e-10)


def test_a_moving_reference_that_stands_still_is_a_settled_reference():
    moving, still = MovingReference(30e-6, 2e-6, 0.1), Reference(30e-6, 2e-6, 0.1)
    assert moving.at(np.array([0.0]))[0] == pytest.approx(still.at(np.array([60.0]))[0], rel=1e-12)
    with pytest.raises(ValueError, match="acceleration_rad_s2 of a pointing reference is nan"):
        MovingReference(30e-6, 2e-6, 0.1, acceleration_rad_s2=math.nan)


@pytest.mark.promise("day-26")
def test_point_ahead_and_rate_of_the_moment_reach_the_mirror(sampler):
    """Same random numbers with and without them: the mirror's mean angle differs by just what they are, on x."""

    def growing(time_s):
        share = (time_s - 1000.0) / 600.0
        return Sight(42e6 + 0 * share, 250e-6 * share, 70e-6 * share)

    still, moved = sampler(contact(geometry=steady(42e6, 0.0, 0.0))), sampler(contact(geometry=growing))
    for number, start in enumerate((1000.0, 1300.0, 1599.6)):
        without, with_it = still.window(number, start, 0.4), moved.window(number, start, 0.4)
        share = (start + 0.2 - 1000.0) / 600.0
        wanted = 70e-6 * share + 0.01 * 250e-6 * share / (2 * math.pi * 0.1)
        assert with_it.mirror_rad[0] - without.mirror_rad[0] == pytest.approx(wanted, abs=0.05e-6)
        assert with_it.mirror_rad[1] - without.mirror_rad[1] == pytest.approx(0.0, abs=0.05e-6)


def test_a_second_mirror_takes_the_point_ahead_and_feedforward_the_rate(file, sampler):
    f = file.mission.fine_pointing
    r = f.reference.model_copy(update={"point_ahead_on_mirror": False, "rate_feedforward": 1.0})
    m = file.mission.model_copy(update={"fine_pointing": f.model_copy(update={"reference": r})})
    seen = sampler(mission=m).window(0, 1000.0, 0.4)
    still = sampler(contact(geometry=steady(42e6, 0.0, 0.0))).window(0, 1000.0, 0.4)
    assert_array_equal(seen.radial_rad, still.radial_rad)


@pytest.mark.promise("day-30")
def test_references_of_a_window_begin_with_it_and_not_with_its_settling(sampler):
    """A line is followed over the window whatever the settling; the references at its begin and its end."""

    def growing(time_s):
        return Sight(42e6 + 0 * time_s, 4e-6 * (time_s - 990.0), 3e-6 * (time_s - 990.0))

    for settle in (0.0, 0.3):
        s = sampler(contact(geometry=growing), settings(settle_s=settle))
        moving = s._moving(growing(np.array([1000.0, 1000.4])), 0.4, settle)[0]
        w = 2 * math.pi * 0.1
        lag = [0.01 * (4e-6 * (10.0 + t) - 4e-6 / w) / w for t in (0.0, 0.4)]
        ahead = np.array([30e-6, 31.2e-6])
        assert_allclose(moving.at(np.array([settle, settle + 0.4])), ahead + lag, rtol=1e-9)


@pytest.mark.promise("day-30")
@pytest.mark.parametrize("corrected", [True, False])
def test_a_point_ahead_that_is_not_corrected_is_that_of_the_geometry(file, sampler, corrected):
    ahead = file.mission.point_ahead.model_copy(update={"corrected": corrected})
    m = file.mission.model_copy(update={"point_ahead": ahead})
    at = steady(42e6, 0.0, 8e-6)(np.zeros(2))
    found = sampler(mission=m).margin_db(np.array([0.0, 5e-6]), at)
    missed = np.array([0.0, 5e-6]) + (0.0 if corrected else 8e-6)
    assert_allclose(found, link.margin_of_error(link.of(file.mission), missed), atol=1e-9)


# -------------------------------------------------------------------------------------------------------- the plan
@pytest.mark.parametrize(
    ("length_s", "begins"),
    [
        (100.0, [0.0, 33.0, 66.0, 99.0]),
        (4.0, [0.0, 1.0, 2.0, 3.0]),
        (3.9, [0.0, 1.45, 2.9]),
        (1.5, [0.0]),
        (0.3, [0.0]),
    ],
)
def test_windows_that_would_overlap_are_fewer(length_s, begins):
    found = plan(5.0, 5.0 + length_s, settings(windows=4, window_s=1.0))
    assert_allclose(found, [(5.0 + b, min(1.0, length_s)) for b in begins], rtol=1e-12)


def test_a_short_contact_has_fewer_windows_and_the_shortest_none(run, finding):
    locked = finding.wide.log[-1].time_s
    for length, count in ((0.9, 2), (0.3, 1), (5e-5, 0)):
        found = run(contact(length_s=locked + length), settings())
        check_order(found)
        assert route(found.log) == [*FIRST, "end"]
        assert len(found.windows) == count
        assert found.sampled_s == pytest.approx(min(0.8, length) if count else 0.0, abs=1e-4)
        assert found.data_s == pytest.approx(length, abs=1e-9)
        assert found.bits(1.0) == pytest.approx(length, abs=1e-9)


def test_the_geometry_is_asked_for_nothing_beyond_the_contact(sampler):
    """Not even by rounding: begin + (end - begin) exceeds some of these ends."""
    asked = []

    def ending(time_s):
        asked.append(float(np.max(time_s)))
        return steady()(time_s)

    draw = np.random.Generator(np.random.Philox(key=1))
    pairs = draw.uniform((-0.1, 0.0), (0.0, 0.01), (200, 2)).tolist()
    past = [(begin, end) for begin, end in pairs if begin + (end - begin) > end][:2]
    assert len(past) == 2
    for begin, end in past:
        of = Contact(-1.0, end, LIMB, LIMB, -1.0, ending)
        sampler(of, settings(settle_s=0.0)).window(0, begin, end - begin)
        assert asked[-1] == end


# ----------------------------------------------------------------------------------------------------- acquisition
def test_a_contact_that_is_shorter_than_the_acquisition_ends_in_it(run, finding):
    stages = {e.stage: e.time_s for e in finding.wide.log}
    for length, state in (
        (5.0, "beacon"),
        (stages["beacon travels"] + 0.5, "detect"),
        (stages["GEO turns and answers"], "answer"),
        (stages["GEO locks"] + 0.01, "lock"),
        (stages["LEO locks"], "lock"),
    ):
        found = run(contact(length_s=length), settings())
        check_order(found)
        assert (found.log[-1].state, found.log[-1].time_s) == (state, 1000.0 + length)
        assert found.log[-1].cause == "the contact ends: eclipse of LEO"
        assert (found.windows, found.data_s, found.data_share, found.bits(3e8)) == ((), 0.0, 0.0, 0.0)
        assert math.isnan(found.first_data_s)
        assert found.seconds[state] > 0.0


def test_an_acquisition_that_never_succeeds_is_given_up(tmp_path, run):
    weak = edited_file(tmp_path, ('required_power = "10 pW"', 'required_power = "1 mW"'), whole=True)
    found = run(contact(), settings(), finding=links(weak).finding)
    check_order(found)
    assert found.log[-1].cause == ("acquisition given up after 5 failures; GEO detects: time-out, failure 5 of 5")
    assert route(found.log) == ["slew", *["beacon", "detect"] * 5, "end"]
    failures = [e for e in found.log if (e.state, e.to) == ("detect", "beacon")]
    assert [e.cause for e in failures] == [f"GEO detects: time-out, failure {n} of 5" for n in (1, 2, 3, 4)]
    assert found.log[-1].time_s < found.contact.end_s
    assert (found.windows, found.data_s) == ((), 0.0)


def test_a_failure_within_an_acquisition_is_logged_and_costs_its_time(run, finding):
    """Seeds of which the first simulated acquisition fails at least once."""
    stages = finding.wide.stages
    logs = {seed: acquisition.simulate_log(stages, 5, seed) for seed in range(200)}
    failing = {s: log for s, log in logs.items() if any("time-out" in e.cause for e in log) and log[-1].to == "locked"}
    assert len(failing) > 5
    for seed, log in list(failing.items())[:5]:
        found = run(contact(), settings(seed=seed, windows=1))
        check_order(found)
        assert found.first_data_s == pytest.approx(1000.0 + log[-1].time_s)
        wanted = [(1000.0 + e.time_s, f"{e.stage}: {e.cause}") for e in log if "time-out" in e.cause]
        assert [(e.time_s, e.cause) for e in found.log if "time-out" in e.cause] == [
            (pytest.approx(time), cause) for time, cause in wanted
        ]


def test_a_failure_that_is_tried_again_in_the_same_state_is_logged(run, finding):
    """An answer that lands three times in ten: the partner answers again."""
    stages = list(finding.wide.stages)
    stages[5] = replace(stages[5], success_probability=0.3)
    odd = replace(finding, wide=replace(finding.wide, stages=tuple(stages)))
    logs = {seed: acquisition.simulate_log(stages, 5, seed) for seed in range(50)}
    failed = {
        s: [e.time_s for e in log if e.to == "GEO turns and answers" and e.cause != "done"] for s, log in logs.items()
    }
    seed = next(s for s, log in logs.items() if len(failed[s]) > 1 and log[-1].to == "locked")
    found, wanted = run(contact(), settings(windows=1, seed=seed), finding=odd), failed[seed]
    check_order(found)
    again = [e for e in found.log if (e.state, e.to) == ("answer", "answer")]
    assert [e.time_s for e in again] == pytest.approx([1000.0 + time for time in wanted])
    assert all(e.cause.startswith("LEO detects the answer: time-out, failure ") for e in again)


def test_a_scan_finds_the_partner_instead(run, finding):
    found = run(contact(), settings(way="scan", windows=1))
    check_order(found)
    assert route(found.log) == [*FIRST, "end"]
    assert found.log[2].cause == "beam travels: done"
    assert found.first_data_s == pytest.approx(1000.0 + finding.scan.log[-1].time_s)
    assert found.first_data_s != pytest.approx(1000.0 + finding.wide.log[-1].time_s)


# ------------------------------------------------------------------------------------------------------------ slew
@pytest.mark.promise("day-28")
def test_a_body_that_is_not_free_in_time_turns_late(run):
    found = run(contact(free_from_s=960.0), settings(windows=1))
    check_order(found)
    assert [e.time_s for e in found.log[:2]] == pytest.approx([960.0, 1060.0])
    assert found.log[0].cause == "1 rad at 10 mrad/s, as soon as the body is free"
    assert found.log[1].cause == f"the slew ends 60 s after the contact began: {LIMB}"
    on_time = run(contact(free_from_s=900.0), settings(windows=1))
    assert [e.time_s for e in on_time.log[:2]] == pytest.approx([900.0, 1000.0])
    assert found.first_data_s == pytest.approx(on_time.first_data_s + 60.0)


def test_a_slew_may_outlast_its_contact(run):
    found = run(contact(length_s=50.0, free_from_s=960.0), settings())
    check_order(found)
    assert [(e.time_s, e.to) for e in found.log] == [(960.0, "slew"), (1050.0, "end")]
    assert found.seconds["slew"] == pytest.approx(90.0)


def test_without_a_slew_the_contact_begins_at_once(run):
    found = run(contact(), settings(slew_angle_rad=0.0, windows=1))
    check_order(found)
    assert [(e.time_s, e.to) for e in found.log[:2]] == [(1000.0, "slew"), (1000.0, "beacon")]
    assert found.seconds["slew"] == 0.0


# ----------------------------------------------------------------------------------------------------- loss of lock
def since_below(window, hold_s, period_s=2e-4):
    """The slow way: when margin has been below 0 dB for longer than it is held, since when."""
    since = None
    for time, margin in zip(window.time_s, window.margin_db, strict=True):
        since = (time if since is None else since) if margin < 0.0 else None
        if since is not None and time + period_s - since > hold_s * (1 + 1e-6):
            return since
    return None


@pytest.fixture(scope="module")
def losing(run, shaken):
    """A contact in which vibration takes the lock from some windows and not from others."""
    return run(contact(), settings(windows=6, seed=2), scene=shaken(*STRONG))


@pytest.mark.promise("readme-8")
@pytest.mark.promise("day-26")
def test_strong_vibration_loses_lock_and_regains_it(losing):
    check_order(losing)
    again = ["loss", "re-acquire", "data"]
    behind = [e for e in losing.log if e.time_s >= losing.first_data_s]
    assert route(behind) == ["data", *again * losing.losses, "end"]
    assert losing.losses == sum(w.loss is not None for w in losing.windows) > 2
    assert any(w.loss is None for w in losing.windows)
    assert [e.to for e in losing.log if e.state == "re-acquire"].count("data") == losing.losses
    assert losing.losses_per_s == pytest.approx(losing.losses / sum(w.seconds for w in losing.windows))
    below = sum(np.sum(w.margin_db < 0.0) for w in losing.windows) * 2e-4
    assert losing.bits(2.0) == pytest.approx(2.0 * losing.data_s * (1.0 - below / losing.sampled_s))
    assert losing.bits(2.0) < 2.0 * losing.data_s


def test_the_cause_of_a_loss_says_what_happened(losing):
    lost = [w.loss for w in losing.windows if w.loss is not None]
    entries = [e for e in losing.log if e.to == "loss"]
    known = [e for e in losing.log if e.state == "loss"]
    assert len(entries) == len(known) == len(lost)
    for loss, entry, after in zip(lost, entries, known, strict=True):
        assert (entry.state, entry.time_s, entry.cause) == ("data", loss.time_s, loss.cause)
        pattern = r"margin below 0 dB for 10.2 ms at (\d+\.\d{3}) s: (\d+) µrad off, range 42000 km"
        since, off = re.fullmatch(pattern, entry.cause).groups()
        assert float(since) == pytest.approx(loss.since_s, abs=6e-4)
        assert 15.0 < float(off) < 300.0
        assert loss.time_s - loss.since_s == pytest.approx(0.0102, abs=1e-9)
        light_s = 2 * 42e6 / C_M_S
        assert (after.time_s, after.to) == (pytest.approx(loss.time_s + light_s), "re-acquire")
        assert after.cause == "the light has gone there and back, 280 ms"


@pytest.mark.promise("day-26")
def test_lock_is_lost_at_the_first_stretch_that_is_too_long(losing):
    for window in losing.windows:
        since = since_below(window, 0.01)
        if window.loss is None:
            assert since is None
        else:
            assert window.loss.since_s == pytest.approx(since, abs=1e-9)
            assert window.time_s[-1] + 2e-4 == pytest.approx(window.loss.time_s)  # and nothing behind it counts
            assert window.seconds == pytest.approx(window.loss.time_s - window.start_s)


def test_a_window_follows_each_new_acquisition(losing):
    begins = [w.start_s for w in losing.windows]
    regained = [e.time_s for e in losing.log if (e.state, e.to) == ("re-acquire", "data")]
    assert begins == sorted(begins)
    assert set(regained) <= set(begins)
    planned = [b for b, _ in plan(losing.first_data_s, 1600.0, settings(windows=6))]
    assert set(begins) == {*regained, *planned}  # nothing is in the way here


def test_a_new_acquisition_begins_with_the_beacon_and_has_its_own_random_numbers(losing, finding):
    starts = [i for i, e in enumerate(losing.log) if (e.state, e.to) == ("loss", "re-acquire")]
    for number, i in enumerate(starts[:-1], 1):  # the last one is cut short by the end
        log = acquisition.simulate_log(finding.wide.stages, 5, 2 + (number << 64))
        last = next(e for e in losing.log[i + 1 :] if e.to == "data")
        assert last.time_s == pytest.approx(losing.log[i].time_s + log[-1].time_s)
        assert losing.log[i + 1].cause == "beacon to detect; beacon travels: done"


def test_lock_that_is_lost_in_each_window_is_given_up(run, shaken):
    found = run(contact(), settings(), scene=shaken(*HARD))
    check_order(found)
    assert route(found.log) == [*FIRST, *["loss", "re-acquire", "data"] * 4, "loss", "end"]
    assert found.log[-1].cause.startswith("given up after 5 losses of lock in as many windows in a row; the light")
    assert found.log[-1].time_s < 1200.0
    assert (found.losses, len(found.windows)) == (5, 5)
    assert 0.0 < found.data_s < 1.0


def test_a_longer_hold_keeps_lock(run, shaken):
    found = run(contact(), settings(hold_s=0.3, seed=2), scene=shaken(*STRONG))
    assert ([e.to for e in found.log][-2:], found.losses) == (["data", "end"], 0)
    assert found.share_below > 0.3


def test_a_contact_may_end_during_the_new_acquisition(run, losing, shaken):
    first = next(e.time_s for e in losing.log if e.to == "loss")
    for after, state in ((-0.005, "data"), (0.1, "loss"), (5.0, "re-acquire")):
        of = Contact(1000.0, first + after, LIMB, LIMB, 0.0, steady())
        found = run(of, settings(windows=1, seed=2), scene=shaken(*STRONG))
        check_order(found)
        assert (found.log[-1].state, found.log[-1].cause) == (state, f"the contact ends: {LIMB}")


def one_by_one(sampler, planned):
    """The windows as `Sampler.window` gives them, each as it is asked for."""
    return (sampler.window(number, *span) for number, span in enumerate(planned))


def test_windows_that_a_new_acquisition_covers_are_left_out(run, whole, monkeypatch):
    """Windows of 1 s side by side, of which the one with this number, counted as they come, loses lock."""
    for losing_at in (0, 5, 20):
        came = []

        def window(self, number, start_s, length_s, came=came, at=losing_at):
            came.append(number)
            loss = Loss(start_s + 0.3, start_s + 0.5, start_s + 0.75, "made up") if number == at else None
            return replace(whole.windows[0], start_s=start_s, seconds=0.5 if loss else length_s, loss=loss)

        monkeypatch.setattr(Sampler, "windows", lambda *args: list(one_by_one(*args)))
        monkeypatch.setattr(Sampler, "window", window)
        found = run(contact(length_s=80.0), settings(windows=100, window_s=1.0))
        check_order(found)
        planned = [b for b, _ in plan(found.first_data_s, 1080.0, settings(windows=100, window_s=1.0))]
        assert (len(planned), found.losses) == (64, 1)
        lost = planned[losing_at]
        again = next(e.time_s for e in found.log if (e.state, e.to) == ("re-acquire", "data"))
        wanted = [b for b in planned if b <= lost] + [again] + [b for b in planned if b >= again + 1.0]
        assert_allclose([w.start_s for w in found.windows], wanted, rtol=0, atol=1e-9)
        assert (sorted(came), came[-1]) == (list(range(65)), 64)  # the one behind the loss has a number of its own


def test_windows_without_a_gap_are_all_there(run, whole, finding, monkeypatch):
    """Data of a whole number of windows: each begins where the one before has ended, but for rounding."""

    def window(self, number, start_s, length_s):
        return replace(whole.windows[0], start_s=start_s, seconds=length_s)

    monkeypatch.setattr(Sampler, "windows", one_by_one)
    monkeypatch.setattr(Sampler, "window", window)
    how, before = settings(windows=40, window_s=0.3, slew_angle_rad=0.0), 0
    for start in range(40):
        found = run(contact(start, finding.wide.log[-1].time_s + 40 * 0.3), how)
        begins = [begin for begin, _ in plan(found.first_data_s, found.contact.end_s, how)]
        assert [w.start_s for w in found.windows] == begins
        before += sum(after < begin + 0.3 for begin, after in pairwise(begins))
    assert before > 10


def test_a_whole_window_ends_a_row_of_losses(run, whole, monkeypatch):
    """Four losses in a row twice, each row ended by a window without; then five."""
    lost_at = [1400.0] * 4 + [1900.0] * 4 + [2400.0] * 5  # each no earlier than that: planned are 1493, 1970, 2446 s

    def window(self, number, start_s, length_s):
        loss = None
        if lost_at and start_s > lost_at[0]:
            lost_at.pop(0)
            loss = Loss(start_s, start_s + 0.1, start_s + 0.1, "made up")
        return replace(whole.windows[0], start_s=start_s, seconds=0.1 if loss else length_s, loss=loss)

    monkeypatch.setattr(Sampler, "windows", one_by_one)
    monkeypatch.setattr(Sampler, "window", window)
    found = run(contact(length_s=2400.0), settings(windows=6))
    check_order(found)
    assert (found.losses, lost_at) == (13, [])
    assert [w.loss is None for w in found.windows] == [True, *([False] * 4 + [True]) * 2, *[False] * 5]
    assert found.log[-1].cause == "given up after 5 losses of lock in as many windows in a row; seen by its own sensor"


@pytest.mark.promise("day-26")
def test_a_spot_beyond_the_field_of_view_is_lost_at_once(run, shaken, design):
    scene = shaken(*HARD)
    narrow = replace(scene.loop.optical, field_of_view_rad=200e-6)
    scene = replace(scene, loop=replace(scene.loop, optical=narrow))
    found = run(contact(), settings(hold_s=0.3, windows=1), scene=scene)
    check_order(found)
    lost = found.windows[0].loss
    pattern = r"spot beyond the optical sensor's field of view at \d+\.\d{3} s: \d+ µrad off, it sees 200 µrad"
    assert re.fullmatch(pattern, lost.cause)
    assert (lost.time_s, lost.known_s) == (pytest.approx(lost.since_s + 2e-4), lost.time_s)
    assert found.windows[0].radial_rad[-1] > 200e-6 >= np.max(found.windows[0].radial_rad[:-1])
    (first, *_) = [e for e in found.log if e.state == "loss"]
    assert (first.time_s, first.cause) == (lost.time_s, "seen by its own sensor")
    span = ensemble.Span(0.6, 0.2, 1)
    assert ensemble.simulate(scene.loop, design.controller, span, 1).counts[0, kernels.COUNT_LOST] > 0


def test_a_slow_sensor_loses_the_spot_only_where_it_looks(sampler, scene):
    slow = replace(scene.loop, optical=replace(scene.loop.optical, every=4, field_of_view_rad=100e-6))
    s = replace(sampler(), loop=slow)
    time, margin = 1000.0 + 2e-4 * np.arange(40), np.ones(40)
    ends = steady()(np.zeros(2))
    for settling, off, wanted in ((0, 8, 8), (0, 9, None), (1, 11, 11), (1, 12, None)):
        radial = np.where(np.arange(40) == off, 101e-6, 0.0)
        loss, kept = s._loss(time, radial, margin, ends, settling)
        assert kept == (40 if wanted is None else wanted + 1)
        assert (loss is None) is (wanted is None)


def test_the_earlier_of_two_losses_counts(sampler, scene):
    s = sampler(how=settings(hold_s=0.001))
    time, ends = 1000.0 + 2e-4 * np.arange(40), steady()(np.zeros(2))
    margin = np.where(np.arange(40) >= 10, -1.0, 1.0)  # six samples are too long: lost with the one at 15
    for off, kept, what in ((15, 16, "spot"), (16, 16, "margin"), (3, 4, "spot")):
        loss, found = s._loss(time, np.where(np.arange(40) == off, 3e-3, 20e-6), margin, ends, 0)
        assert (found, loss.cause.split()[0]) == (kept, what)
        light_s = 2.0 * float(ends.range_m[0]) / 299_792_458.0 if what == "margin" else 0.0  # there and back
        assert loss.known_s - loss.time_s == pytest.approx(light_s, rel=1e-9, abs=1e-9)


def test_what_the_mirror_does_behind_a_loss_is_not_in_its_mean_angle(sampler, scene):
    narrow = replace(scene.loop, optical=replace(scene.loop.optical, every=1, field_of_view_rad=100e-6))
    error, angle = np.zeros((50, 2)), np.full((50, 2), 9e-3)
    error[39], angle[10:40] = 101e-6, (1e-3, 2e-3)  # ten samples of settling, and lost with the thirtieth behind it
    window = replace(sampler(), loop=narrow)._of(1000.0, steady()(np.zeros(2)), 0.008, error, angle, 10)
    assert window.radial_rad.size == 30
    assert_allclose(window.mirror_rad, narrow.optics @ [1e-3, 2e-3], rtol=1e-12)


@pytest.mark.parametrize("length", [1, 2, 3, 7])
def test_the_first_run_is_the_one_that_a_loop_finds(length):
    draw = np.random.Generator(np.random.Philox(key=5))
    for size in (1, 5, 60):
        for _ in range(40):
            holds = draw.random(size) < 0.6
            wanted = next((i for i in range(size - length + 1) if holds[i : i + length].all()), None)
            assert first_run(holds, length) == wanted


# ------------------------------------------------------------------------------------------------------------ seeds
def test_the_same_seed_gives_the_same_contact_and_another_does_not(run, losing, shaken):
    again = run(contact(), settings(windows=6, seed=2), scene=shaken(*STRONG))
    assert again.log == losing.log
    for one, other in zip(again.windows, losing.windows, strict=True):
        assert_array_equal(one.radial_rad, other.radial_rad)
    different = run(contact(), settings(windows=6, seed=3), scene=shaken(*STRONG))
    assert different.log != losing.log
    assert different.windows[0].rms_rad != losing.windows[0].rms_rad


def test_windows_do_not_share_their_random_numbers(whole):
    assert len({w.largest_rad for w in whole.windows}) == 8
    shared = np.corrcoef([w.radial_rad for w in whole.windows]) - np.eye(8)
    assert np.max(np.abs(shared)) < 0.2


# --------------------------------------------------------------------------------------------------------- refusals
@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"slew_angle_rad": -0.1}, r"slew_angle_rad of a contact run is -0.1: .*from 0 to pi rad"),
        ({"slew_angle_rad": math.nan}, "slew_angle_rad of a contact run is nan"),
        ({"slew_rate_rad_s": 0.0}, "slew_rate_rad_s of a contact run is 0: .*above 0 rad/s"),
        ({"slew_rate_rad_s": math.inf}, "slew_rate_rad_s of a contact run is inf: it must be finite"),
        ({"windows": 0}, "windows of a contact run is 0: .*from 1 to"),
        ({"window_s": 0.0}, "window_s of a contact run is 0: .*above 0 s"),
        ({"settle_s": -1.0}, "settle_s of a contact run is -1: .*at least 0 s"),
        ({"hold_s": 0.4}, r"hold_s of a contact run is 0.4: .*below window_s \(400 ms\)"),
        ({"seed": -1}, "seed of a contact run is -1: .*2\\^63"),
        ({"way": "shout"}, 'way of a contact run is "shout": it must be "wide beacon" or "scan"'),
    ],
)
def test_settings_without_a_meaning_are_refused(changes, message):
    with pytest.raises(ValueError, match=message):
        settings(**changes)


def test_a_contact_without_length_and_a_body_that_is_late_are_refused():
    with pytest.raises(ValueError, match="a contact from 1000 s to 1000 s has no length"):
        contact(length_s=0.0)
    with pytest.raises(ValueError, match="a contact from nan s"):
        contact(start_s=math.nan)
    with pytest.raises(ValueError, match="free_from_s is 1001 s, and the contact begins at 1000 s"):
        contact(free_from_s=1001.0)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ((-1.0, 1e-4, 1e-5), r"range_m = -1 at 1000.000 s, which must be finite and above 0"),
        ((math.nan, 1e-4, 1e-5), "range_m = nan at 1000.000 s"),
        ((4e7, -1e-4, 1e-5), "rate_rad_s = -0.0001 at 1000.000 s, which must be finite and at least 0"),
        ((4e7, 1e-4, math.inf), "point_ahead_rad = inf at 1000.000 s"),
    ],
)
def test_a_geometry_that_is_none_is_refused(values, message):
    with pytest.raises(ValueError, match=message):
        contact(geometry=steady(*values)).sight(np.array([1000.0, 1001.0]))
    with pytest.raises(ValueError, match=r"range_m with the shape \(\) for times of \(2,\)"):
        contact(geometry=lambda time_s: Sight(4e7, 1e-4, 1e-5)).sight(np.array([1000.0, 1001.0]))


def test_a_mission_without_what_a_contact_needs_is_refused(file, run, finding):
    with pytest.raises(ValueError, match=r'no table \[acquisition.scan\].*"wide beacon"'):
        run(contact(), settings(way="scan"), finding=replace(finding, scanned=None))
    odd = replace(finding, wide=replace(finding.wide, stages=finding.wide.stages[1:]))
    with pytest.raises(ValueError, match='"wide beacon" has 10 stages, a contact run knows the 11'):
        run(contact(), settings(), finding=odd)
    with pytest.raises(ValueError, match=r"window_s of a contact run is 50 µs, less than a control period \(200 µs\)"):
        run(contact(), settings(window_s=5e-5, hold_s=0.0))
    with pytest.raises(ValueError, match=r"1000 windows of 2 s .* 10000000 control samples .* at most 5000000"):
        run(contact(), settings(windows=1000, window_s=2.0))
    beam = file.mission.communication.model_copy(update={"data_rate_bit_s": math.nan})
    with pytest.raises(ValueError, match='"largest" has to be solved for first'):
        run(contact(), settings(), mission=file.mission.model_copy(update={"communication": beam}))


@pytest.mark.parametrize("missing", ["", "table", "acquisition", "finding", "loop", "contacts"])
def test_a_contact_runs_where_the_mission_has_all_that_it_needs(monkeypatch, missing):
    asked = SimpleNamespace(slew_angle_rad=1.0, slew_rate_rad_s=0.1, windows=3, window_s=2.0, hold_s=0.5, number=2)
    contacts = [SimpleNamespace(start_s=10.0 * k, end_s=10.0 * k + 5.0, begins=f"b{k}", ends=f"e{k}") for k in (1, 2)]
    day = SimpleNamespace(
        relay=SimpleNamespace(contacts=[] if missing == "contacts" else contacts),
        view=SimpleNamespace(pair=SimpleNamespace(span_s=(-7.0, 90.0))),
    )
    fine = SimpleNamespace(
        scene=SimpleNamespace(table=SimpleNamespace(settle_s=0.3)), best=SimpleNamespace(design="the best")
    )
    monkeypatch.setattr(sequence, "run_contact", lambda *given: given)

    def ran(number):
        asked.number = number
        return sequence.of_mission(
            SimpleNamespace(contact=None if missing == "table" else asked, seed=5, acquisition="scan"),
            None if missing == "acquisition" else SimpleNamespace(attempts=4),
            "the link",
            day,
            None if missing == "finding" else "the acquisition",
            None if missing == "loop" else fine,
        )

    if missing:
        assert ran(1) is None
        return
    data, found, scene, design, of, how = ran(2)
    assert (data, found, scene, design) == ("the link", "the acquisition", fine.scene, "the best")
    assert (of.start_s, of.end_s, of.begins, of.ends, of.free_from_s) == (20.0, 25.0, "b2", "e2", 15.0)
    assert (how.seed, how.attempts, how.way, how.settle_s, how.hold_s, how.window_s) == (5, 4, "scan", 0.3, 0.5, 2.0)
    assert (how.slew_angle_rad, how.slew_rate_rad_s, how.windows) == (1.0, 0.1, 3)
    assert ran(1)[4].free_from_s == -7.0  # before the first the body is free from the beginning


# -------------------------------------------------------------------------------------------- limits, one by one
@pytest.mark.parametrize(
    ("changes", "name"),
    [
        ({"slew_angle_rad": 0.0}, ""),
        ({"slew_angle_rad": math.pi}, ""),
        ({"slew_angle_rad": -1e-9}, "slew_angle_rad"),
        ({"slew_angle_rad": math.pi + 1e-9}, "slew_angle_rad"),
        ({"slew_rate_rad_s": 1e-9}, ""),
        ({"slew_rate_rad_s": 0.0}, "slew_rate_rad_s"),
        ({"slew_rate_rad_s": math.inf}, "slew_rate_rad_s"),
        ({"windows": 1}, ""),
        ({"windows": 100_000}, ""),
        ({"windows": 0}, "windows"),
        ({"windows": 100_001}, "windows"),
        ({"window_s": 0.0, "hold_s": 0.0}, "window_s"),
        ({"window_s": math.inf}, "window_s"),
        ({"settle_s": 0.0}, ""),
        ({"settle_s": -1e-9}, "settle_s"),
        ({"hold_s": 0.0}, ""),
        ({"hold_s": -1e-9}, "hold_s"),
        ({"hold_s": 0.4}, "hold_s"),
        ({"hold_s": 0.399}, ""),
        ({"seed": 0}, ""),
        ({"seed": 2**63 - 1}, ""),
        ({"seed": -1}, "seed"),
        ({"seed": 2**63}, "seed"),
        ({"way": "scan"}, ""),
        ({"way": "beacon"}, "way"),
    ],
)
def test_settings_are_taken_up_to_their_bounds(changes, name):
    if not name:
        assert settings(**changes) == replace(settings(), **changes)
        return
    with pytest.raises(ValueError, match=f"^{name} of a contact run is "):
        settings(**changes)


def test_windows_hold_a_sample_each_and_no_more_together_than_memory_does(sampler, monkeypatch):
    made = sampler(how=settings(windows=4, window_s=0.4))
    period = made.loop.timing.period_s
    samples = 4 * 0.4 / period
    monkeypatch.setattr(drawn_windows, "MOST_SAMPLES", samples)
    assert replace(made).settings == made.settings
    monkeypatch.setattr(drawn_windows, "MOST_SAMPLES", samples - 1)
    with pytest.raises(ValueError, match=r"^4 windows of 400 ms hold 8000 control samples of a contact run"):
        replace(made)
    short = settings(window_s=0.6 * period, hold_s=0.0)
    assert replace(made, settings=replace(short, windows=1)).settings.window_s == 0.6 * period
    with pytest.raises(ValueError, match="less than a control period"):
        replace(made, settings=settings(window_s=0.4 * period, hold_s=0.0))
    assert made.windows([(1000.0, 0.4 * period), (1001.0, 0.4 * period)]) == [None, None]


def test_where_the_mission_has_no_point_ahead_none_is_missed(sampler):
    made = sampler()
    none = replace(made, data=replace(made.data, shared=replace(made.data.shared, point_ahead=None)))
    far, near = (none.margin_db(np.zeros(2), steady(42e6, 0.0, ahead)(np.zeros(2))) for ahead in (30e-6, 0.0))
    assert_allclose(far, near, rtol=1e-12)


@pytest.mark.parametrize(
    ("start_s", "end_s", "free_s", "refused"),
    [
        (5.0, 5.1, 5.0, ""),
        (5.0, 5.0, 0.0, "has no length"),
        (5.0, 4.0, 0.0, "has no length"),
        (-math.inf, 5.0, -9.0, "has no length"),
        (5.0, math.inf, 0.0, "has no length"),
        (5.0, 6.0, 5.1, "free_from_s is 5.1 s"),
        (5.0, 6.0, -math.inf, "free_from_s is -inf s"),
    ],
)
def test_a_contact_has_a_length_and_a_body_that_is_free_by_then(start_s, end_s, free_s, refused):
    if not refused:
        assert Contact(start_s, end_s, "", "", free_s, steady()).free_from_s == free_s
        return
    with pytest.raises(ValueError, match=re.escape(refused)):
        Contact(start_s, end_s, "", "", free_s, steady())


@pytest.mark.parametrize(
    ("values", "refused"),
    [
        ((1e-9, 0.0, 0.0), ""),
        ((0.0, 1.0, 1.0), "range_m = 0"),
        ((1.0, -1e-9, 1.0), "rate_rad_s = -1e-09"),
        ((1.0, 1.0, -1e-9), "point_ahead_rad = -1e-09"),
        ((1.0, math.inf, 1.0), "rate_rad_s = inf"),
    ],
)
def test_a_line_of_sight_has_a_range_above_nothing_and_rates_that_may_be_none(values, refused):
    of = contact(geometry=steady(*values))
    if not refused:
        assert [float(each[0]) for each in of.sight(np.zeros(2))] == list(values)
        return
    with pytest.raises(ValueError, match=re.escape(refused)):
        of.sight(np.zeros(2))


@pytest.mark.parametrize(
    ("length_s", "wanted", "begins", "each_s"),
    [
        (10.0, 3, [0.0, 4.0, 8.0], 2.0),
        (6.0, 3, [0.0, 2.0, 4.0], 2.0),  # they just fit
        (5.9, 3, [0.0, 3.9], 2.0),
        (4.0, 1, [0.0], 2.0),
        (2.0, 3, [0.0], 2.0),
        (1.5, 3, [0.0], 1.5),
    ],
)
def test_windows_are_as_many_as_fit_from_the_begin_to_the_end(length_s, wanted, begins, each_s):
    found = plan(100.0, 100.0 + length_s, settings(windows=wanted, window_s=2.0))
    assert_allclose([begin for begin, _ in found], 100.0 + np.array(begins))
    assert_allclose([length for _, length in found], each_s)


def test_a_log_ends_with_its_contact_and_goes_on_from_there_no_more():
    log = sequence.Log(contact(1000.0, 600.0))
    assert log.go(900.0, State.SLEW, "a") and log.since_s == 900.0 and log.state == State.SLEW
    assert log.go(1599.9, State.BEACON, "b")
    assert not log.go(1600.0, State.DETECT, "c")
    assert not log.go(1200.0, State.DETECT, "d")
    log.finish()
    found = [(each.time_s, each.state, each.to) for each in log.entries]
    assert found == [
        (900.0, State.IDLE, State.SLEW),
        (1599.9, State.SLEW, State.BEACON),
        (1600.0, State.BEACON, State.END),
    ]
    assert log.entries[-1].cause == "the contact ends: eclipse of LEO"
    late = sequence.Log(contact(1000.0, 600.0))
    assert not late.go(1700.0, State.SLEW, "a") and late.entries[-1].time_s == 1600.0
    whole = sequence.Log(contact(1000.0, 600.0))
    whole.finish()
    assert [(each.time_s, each.to) for each in whole.entries] == [(1600.0, State.END)]


@pytest.mark.parametrize(
    ("free_s", "slew", "beacon", "words"),
    [
        (0.0, 900.0, 1000.0, "ends when the contact begins"),
        (900.0, 900.0, 1000.0, "ends when the contact begins"),  # free in time to the second
        (900.5, 900.5, 1000.5, "as soon as the body is free"),
        (1000.0, 1000.0, 1100.0, "as soon as the body is free"),
    ],
)
def test_a_slew_ends_with_the_begin_of_its_contact_where_the_body_is_free_in_time(free_s, slew, beacon, words):
    log = sequence.Log(contact(1000.0, 600.0, free_from_s=free_s))
    assert sequence._turn(log, settings(slew_angle_rad=1.0, slew_rate_rad_s=0.01))
    assert [(each.time_s, each.to) for each in log.entries] == [(slew, State.SLEW), (beacon, State.BEACON)]
    assert words in log.entries[0].cause
    late = log.entries[1].cause
    after = {1000.0: "the contact begins", 1000.5: "500 ms after the", 1100.0: "100 s after the contact began"}
    assert after[beacon] in late
    assert LIMB in late


@pytest.mark.parametrize(("losses", "goes_on"), [(1, True), (2, True), (3, False), (4, False)])
def test_as_many_losses_in_a_row_as_attempts_are_the_end(losses, goes_on):
    acquired = []

    class Acquire:
        attempts = 3

        def __call__(self):
            acquired.append(1)
            return True

    log = sequence.Log(contact(1000.0, 600.0))
    log.go(1100.0, State.DATA, "")
    assert sequence._regain(log, Acquire(), Loss(1200.0, 1201.0, 1201.5, "dark"), losses) is goes_on
    assert [(each.time_s, each.to) for each in log.entries[1:]] == [
        (1201.0, State.LOSS),
        (1201.5, State.REACQUIRE if goes_on else State.END),
    ]
    assert len(acquired) == goes_on
    assert "the light has gone there and back, 500 ms" in log.entries[-1].cause
    own = sequence.Log(contact(1000.0, 600.0))
    own.go(1100.0, State.DATA, "")
    sequence._regain(own, Acquire(), Loss(1200.0, 1201.0, 1201.0, "off"), losses)
    assert "seen by its own sensor" in own.entries[-1].cause
    over = sequence.Log(contact(1000.0, 600.0))
    over.go(1100.0, State.DATA, "")
    assert not sequence._regain(over, Acquire(), Loss(1599.0, 1600.0, 1601.0, "dark"), 1)
    assert over.entries[-1].to == State.END and len(over.entries) == 2


def test_the_sums_of_a_contact_are_those_of_its_log_and_its_windows():
    steps = [
        (900.0, State.IDLE, State.SLEW), (1000.0, State.SLEW, State.BEACON), (1010.0, State.BEACON, State.DATA),
        (1100.0, State.DATA, State.LOSS), (1101.0, State.LOSS, State.REACQUIRE), (1111.0, State.REACQUIRE, State.DATA),
        (1600.0, State.DATA, State.END),
    ]  # fmt: skip
    log = tuple(Transition(time_s, state, to, "") for time_s, state, to in steps)
    windows = tuple(SimpleNamespace(seconds=s, share_below=share) for s, share in ((3.0, 0.5), (1.0, 0.1)))
    run = ContactRun(contact(1000.0, 600.0), log, windows)
    spent = {"slew": 100.0, "beacon": 10.0, "data": 90.0 + 489.0, "loss": 1.0, "re-acquire": 10.0}
    assert {str(state): time for state, time in run.seconds.items() if time} == spent
    assert (run.data_s, run.data_share, run.losses, run.first_data_s) == (579.0, 579.0 / 600.0, 1, 1010.0)
    assert (run.sampled_s, run.losses_per_s, run.share_below) == (4.0, 0.25, pytest.approx(0.4))
    assert run.bits(10.0) == pytest.approx(10.0 * 579.0 * 0.6)
    none = ContactRun(contact(1000.0, 600.0), log[:2], ())
    assert (none.sampled_s, none.losses_per_s, none.share_below, none.data_s, none.bits(9.0)) == (0, 0.0, 0.0, 0.0, 0.0)
    assert math.isnan(none.first_data_s)


@pytest.mark.parametrize(
    ("holds", "length", "begin"),
    [
        ("110111", 2, 0), ("110111", 3, 3), ("110111", 4, None), ("0001", 1, 3), ("0", 1, None), ("", 1, None),
        ("1111", 4, 0), ("1111", 5, None), ("0110110", 2, 1),
    ],
)  # fmt: skip
def test_a_run_is_long_enough_from_its_length_on(holds, length, begin):
    assert first_run(np.array([each == "1" for each in holds], dtype=bool), length) == begin


@pytest.mark.parametrize(("lost_s", "left_s"), [(1597.0, 2.0), (1598.5, 0.5), (1590.0, 2.0)])
def test_a_window_behind_a_loss_ends_with_its_contact(lost_s, left_s):
    """A window of 2 s at the begin of data, one behind its loss and one right before the end of the contact."""
    log, asked = sequence.Log(contact(1000.0, 600.0)), []
    log.go(1100.0, State.DATA, "")

    class Acquire:
        attempts = 5

        def __call__(self):
            return log.go(lost_s + 1.0, State.DATA, "")

    def made(start_s, length_s, loss=None):
        return SimpleNamespace(start_s=start_s, seconds=length_s, loss=loss)

    def windows(planned):
        asked.extend(planned)
        (first, length), *others = planned
        return [made(first, length, Loss(lost_s, lost_s, lost_s, "dark")), *(made(*each) for each in others)]

    def window(number, start_s, length_s):
        asked.append((number, start_s, length_s))
        return made(start_s, length_s)

    sampler = SimpleNamespace(
        settings=settings(windows=2, window_s=2.0),
        windows=windows,
        window=window,
        loop=SimpleNamespace(timing=SimpleNamespace(period_s=1e-3)),
    )
    found = sequence._data(log, Acquire(), sampler)
    assert asked == [(1100.0, 2.0), (1598.0, 2.0), (2, lost_s + 1.0, left_s)]
    behind = [each.start_s for each in found]
    last = [1598.0] if lost_s + 3.0 <= 1598.0 else []  # it would begin before the one behind the loss has ended
    assert behind == [1100.0, lost_s + 1.0, *last]


def refusal(call, *given, **named):
    """The words in which a call refuses what it is given."""
    with pytest.raises(ValueError) as error:
        call(*given, **named)
    return str(error.value)


def logged(log):
    """Every entry of a log, in its words."""
    return " || ".join(f"{e.time_s:g} {e.state} {e.to} {e.cause}" for e in log.entries)


def turned(**free):
    """The log of a slew by 1.25 rad in 50 s."""
    log = sequence.Log(contact(1000.0, 600.0, **free))
    sequence._turn(log, settings(slew_angle_rad=1.25, slew_rate_rad_s=0.025))
    return logged(log)


def regained(lost, losses, length_s=600.0):
    """The log of a loss behind 120 s of data, where three in a row are too many."""
    log = sequence.Log(contact(1000.0, length_s))
    log.go(1080.0, State.DATA, "locked")

    class Acquire:
        attempts = 3

        def __call__(self):
            return log.go(1230.0, State.DATA, "again")

    sequence._regain(log, Acquire(), lost, losses)
    return logged(log)


def stepped(*entries, again=False, length_s=600.0):
    """The log of an acquisition of eleven stages that goes by these entries: time, stage, where it leads, and why."""
    found = SimpleNamespace(name="wide beacon", stages=[SimpleNamespace(name=f"s{place}") for place in range(11)])
    log = sequence.Log(contact(1000.0, length_s))
    log.go(1000.0, State.BEACON, "begun")
    acquire = sequence._Acquisitions(log, found, 7, 1)
    for time_s, stage, to, cause in entries:
        acquire._step(time_s, SimpleNamespace(stage=stage, to=to, cause=cause), again)
    return logged(log)


ALL_OF_A_CONTACT = {
    "settings with a slew the wrong way": (
        lambda: refusal(settings, slew_angle_rad=-0.125),
        "slew_angle_rad of a contact run is -0.125: it must be finite and from 0 to pi rad",
    ),
    "settings with a slew by more than half a turn": (
        lambda: refusal(settings, slew_angle_rad=3.25),
        "slew_angle_rad of a contact run is 3.25: it must be finite and from 0 to pi rad",
    ),
    "settings with a slew that stands": (
        lambda: refusal(settings, slew_rate_rad_s=0.0),
        "slew_rate_rad_s of a contact run is 0: it must be finite and above 0 rad/s",
    ),
    "settings with no window": (
        lambda: refusal(settings, windows=0),
        "windows of a contact run is 0: it must be finite and from 1 to 100000",
    ),
    "settings with too many windows": (
        lambda: refusal(settings, windows=100_001),
        "windows of a contact run is 100001: it must be finite and from 1 to 100000",
    ),
    "settings with a window without length": (
        lambda: refusal(settings, window_s=0.0),
        "window_s of a contact run is 0: it must be finite and above 0 s",
    ),
    "settings with a settling before": (
        lambda: refusal(settings, settle_s=-0.5),
        "settle_s of a contact run is -0.5: it must be finite and at least 0 s",
    ),
    "settings with a hold as long as a window": (
        lambda: refusal(settings, window_s=0.25, hold_s=0.375),
        """
        hold_s of a contact run is 0.375: it must be finite and at least 0 s and below window_s (250 ms): a window
        shows no loss that takes longer
        """,
    ),
    "settings with a seed below nothing": (
        lambda: refusal(settings, seed=-3),
        "seed of a contact run is -3: it must be finite and from 0 to 2^63 - 1",
    ),
    "settings with another way": (
        lambda: refusal(settings, way="beacon"),
        """
        way of a contact run is "beacon": it must be "wide beacon" or "scan"
        """,
    ),
    "a contact that ends before": (
        lambda: refusal(Contact, 5.5, 4.25, "", "", 0.0, None),
        "a contact from 5.5 s to 4.25 s has no length: its end must be finite and come after its begin",
    ),
    "a contact whose body is late": (
        lambda: refusal(Contact, 5.5, 9.25, "", "", 6.75, None),
        """
        free_from_s is 6.75 s, and the contact begins at 5.5 s: it must be finite and no later; where the body is
        busy for longer, let the contact begin later
        """,
    ),
    "a geometry of another shape": (
        lambda: refusal(contact(geometry=lambda t: Sight(t + 1.0, t[1:], t)).sight, np.array([1.0, 2.0, 3.0])),
        "the geometry gives rate_rad_s with the shape (2,) for times of (3,)",
    ),
    "a geometry whose second time is none": (
        lambda: refusal(
            contact(geometry=lambda t: Sight(t, t, np.array([0.0, -2.5, np.nan]))).sight, np.array([1.5, 2.5, 3.5])
        ),
        """
        the geometry gives point_ahead_rad = -2.5 at 2.500 s, which must be finite and at least 0: is that time
        within what the orbits cover?
        """,
    ),
    "a slew in time": (
        lambda: turned(free_from_s=900.0),
        """
        950 idle slew 1.25 rad at 25 mrad/s, so that the slew ends when the contact begins || 1000 slew beacon the
        contact begins: the Earth's limb
        """,
    ),
    "a slew that is late": (
        lambda: turned(free_from_s=962.5),
        """
        962.5 idle slew 1.25 rad at 25 mrad/s, as soon as the body is free || 1012.5 slew beacon the slew ends 12.5
        s after the contact began: the Earth's limb
        """,
    ),
    "a loss by the light": (
        lambda: regained(Loss(1200.0, 1200.25, 1200.5, "dark"), 2),
        """
        1080 idle data locked || 1200.25 data loss dark || 1200.5 loss re-acquire the light has gone there and back,
        250 ms || 1230 re-acquire data again
        """,
    ),
    "a loss by the sensor": (
        lambda: regained(Loss(1200.0, 1200.25, 1200.25, "off"), 1),
        """
        1080 idle data locked || 1200.25 data loss off || 1200.25 loss re-acquire seen by its own sensor || 1230
        re-acquire data again
        """,
    ),
    "the last loss": (
        lambda: regained(Loss(1200.0, 1200.25, 1200.75, "dark"), 3),
        """
        1080 idle data locked || 1200.25 data loss dark || 1200.75 loss end given up after 3 losses of lock in as
        many windows in a row; the light has gone there and back, 500 ms
        """,
    ),
    "a loss that is known too late": (
        lambda: regained(Loss(1200.0, 1200.25, 1201.25, "dark"), 1, length_s=201.0),
        """
        1080 idle data locked || 1200.25 data loss dark || 1201 loss end the contact ends: eclipse of LEO
        """,
    ),
    "an acquisition": (
        lambda: stepped(
            (1001.0, "s0", "s1", "seen"),
            (1002.0, "s1", "s2", "found"),
            (1003.0, "s2", "s3", "told"),
            (1004.5, "s3", "s4", "turned"),
            (1005.0, "s5", "s6", "met"),
            (1007.0, "s10", acquisition.LOCKED, "held"),
        ),
        """
        1000 idle beacon begun || 1002 beacon detect s1: found || 1003 detect answer s2: told || 1005 answer lock
        s5: met || 1007 lock data s10: held
        """,
    ),
    "an acquisition that begins again": (
        lambda: stepped(
            (1001.0, "s1", "s0", "not seen"), (1003.0, "s4", "s0", "lost"), (1009.0, "s7", acquisition.LOST, "dark")
        ),
        """
        1000 idle beacon begun || 1001 beacon beacon s1: not seen || 1003 beacon beacon s4: lost || 1009 beacon end
        acquisition given up after 7 failures; s7: dark
        """,
    ),
    "an acquisition behind a loss": (
        lambda: stepped(
            (1001.0, "s1", "s2", "found"),
            (1003.0, "s4", "s0", "lost"),
            (1009.0, "s9", acquisition.LOCKED, "held"),
            again=True,
        ),
        """
        1000 idle beacon begun || 1001 beacon re-acquire beacon to detect; s1: found || 1003 re-acquire re-acquire
        answer to beacon; s4: lost || 1009 re-acquire data s9: held
        """,
    ),
    "an acquisition that the contact cuts short": (
        lambda: stepped((1001.0, "s3", "s4", "turned"), (1010.0, "s6", "s7", "met"), length_s=10.0),
        "1000 idle beacon begun || 1010 beacon end the contact ends: eclipse of LEO",
    ),
}


@pytest.mark.parametrize("what", ALL_OF_A_CONTACT)
def test_what_a_contact_does_and_refuses_is_told_in_full(what):
    call, words = ALL_OF_A_CONTACT[what]
    assert one_line(str(call())) == one_line(words)


def test_a_window_has_every_number_of_its_samples(sampler, file):
    s = sampler()
    ends = Sight(np.array([40e6, 41e6]), np.array([90e-6, 95e-6]), np.array([28e-6, 29e-6]))
    time, radial = 1000.0 + 2e-4 * np.arange(5), np.array([3.0, 1.0, 4.0, 1.0, 5.0]) * 1e-6
    margin = np.array([2.0, -1.0, 0.0, -3.0, 5.0])
    loss = Loss(1000.0, 1000.1, 1000.2, "dark")
    found = s._window(ends, np.array([7e-6, -8e-6]), loss, (time, radial, margin))
    assert (found.start_s, found.seconds, found.range_m) == (1000.0, pytest.approx(1e-3), 40e6)
    assert (found.point_ahead_rad, found.rate_rad_s, found.loss) == (28e-6, 90e-6, loss)
    assert found.rms_rad == pytest.approx(1e-6 * math.sqrt(52.0 / 5.0))
    assert found.quantile_rad == pytest.approx(np.quantile(radial, file.mission.fine_pointing.quantile))
    assert (found.largest_rad, found.lowest_margin_db, found.share_below) == (radial[4], -3.0, 0.4)
    assert found.mirror_rad == (7e-6, -8e-6)


def test_a_window_lies_between_its_ends_in_the_share_of_its_length(sampler):
    s = sampler()
    ends = Sight(np.array([40e6, 48e6]), np.array([90e-6, 98e-6]), np.array([28e-6, 32e-6]))
    between = drawn_windows._between(ends, np.array([0.0, 0.25, 1.0]))
    assert_allclose(between.range_m, [40e6, 42e6, 48e6])
    assert_allclose(between.rate_rad_s, [90e-6, 92e-6, 98e-6])
    assert_allclose(between.point_ahead_rad, [28e-6, 29e-6, 32e-6])
    error, angle = np.zeros((12, 2)), np.zeros((12, 2))
    window = s._of(1000.0, ends, 4 * s.loop.timing.period_s, error, angle, 8)
    far = [float(s.margin_db(np.zeros(1), drawn_windows._between(ends, np.array([k / 4.0])))[0]) for k in range(4)]
    assert_allclose(window.margin_db, far, rtol=1e-9)


def test_references_of_a_moment_move_with_what_is_left_of_both_rates(sampler):
    s = sampler()
    table = s.table.model_copy(
        update={
            "reference": s.table.reference.model_copy(update={"rate_feedforward": 0.75, "point_ahead_on_mirror": True}),
            "body": s.table.body.model_copy(update={"bandwidth_hz": 0.125}),
        }
    )
    ends = Sight(np.array([40e6, 41e6]), np.array([90e-6, 98e-6]), np.array([28e-6, 30e-6]))
    moving, *others = replace(s, table=table)._moving(ends, 4.0, 0.5)
    assert astuple(moving) == pytest.approx(
        astuple(
            MovingReference(
                point_ahead_rad=28e-6 - 0.5e-6 * 0.5,
                line_of_sight_rate_rad_s=0.25 * 90e-6 - 0.5e-6 * 0.5,
                body_bandwidth_hz=0.125,
                point_ahead_rate_rad_s=0.5e-6,
                acceleration_rad_s2=0.5e-6,
            )
        ),
        rel=1e-9,
    )
    assert others == list(s.loop.references[1:])


def test_a_loss_by_the_margin_and_one_by_the_spot_are_told_with_every_number(sampler):
    s = sampler(how=settings(hold_s=0.001))
    time, ends = 1000.0 + 2e-4 * np.arange(40), Sight(*(np.array([v, 1.2 * v]) for v in (40e6, 90e-6, 28e-6)))
    margin = np.where(np.arange(40) >= 10, -1.0, 1.0)
    radial = np.where(np.arange(40) == 12, 23.4e-6, 11e-6)
    loss, kept = s._loss(time, radial, margin, ends, 0)
    assert (kept, loss.since_s, loss.time_s) == (16, pytest.approx(1000.002), pytest.approx(1000.0032))
    assert loss.cause == "margin below 0 dB for 1.2 ms at 1000.002 s: 23 µrad off, range 42000 km"
    assert loss.known_s - loss.time_s == pytest.approx(2.0 * 42e6 / C_M_S)
    seen = s.loop.optical.field_of_view_rad
    far = np.where(np.arange(40) == 3, 1.25 * seen, 0.0)
    loss, kept = replace(s, loop=replace(s.loop, optical=replace(s.loop.optical, every=1)))._loss(
        time, far, margin, ends, 0
    )
    assert kept == 4
    sees = f"{format_quantity(1.25 * seen, 'rad', 2)} off, it sees {format_quantity(seen, 'rad')}"
    assert loss.cause == f"spot beyond the optical sensor's field of view at 1000.001 s: {sees}"
    assert (loss.time_s, loss.known_s) == (pytest.approx(1000.0008), loss.time_s)


@pytest.mark.parametrize(("place", "free_s"), [(0, -50.0), (1, 320.0), (2, 990.0)])
def test_the_body_is_free_from_the_end_of_the_contact_before(monkeypatch, place, free_s):
    words = [("dawn", "dusk"), ("rise", "set"), ("slot", "slot's end")]
    times = [(100.0, 320.0), (700.0, 990.0), (1200.0, 1500.0)]
    contacts = [
        SimpleNamespace(start_s=a, end_s=b, begins=begins, ends=ends)
        for (a, b), (begins, ends) in zip(times, words, strict=True)
    ]
    ends = SimpleNamespace(orbit="low"), SimpleNamespace(orbit="high")
    pair = SimpleNamespace(span_s=(-50.0, 2000.0), leo=ends[0], geo=ends[1])
    day = SimpleNamespace(view=SimpleNamespace(pair=pair), relay=SimpleNamespace(contacts=contacts))
    found = sequence._contact(day, place)
    assert (found.start_s, found.end_s, found.begins, found.ends) == (*times[place], *words[place])
    assert found.free_from_s == free_s

    def sight(low, high, time_s):
        assert (low, high, time_s.shape) == ("low", "high", (6,))
        return SimpleNamespace(range_m=time_s + 1.0, rate_rad_s=time_s + 2.0, point_ahead_rad=time_s + 3.0)

    monkeypatch.setattr(sequence.orbit, "sight", sight)
    at = np.arange(6.0).reshape(2, 3)
    seen = found.geometry(at)
    for name, more in (("range_m", 1.0), ("rate_rad_s", 2.0), ("point_ahead_rad", 3.0)):
        np.testing.assert_array_equal(getattr(seen, name), at + more)


@pytest.mark.parametrize(("dark", "at"), [(3, None), (4, (0.5, 0.9, 0.9 + 2.0 * 2.375e7 / C_M_S, 9))])
def test_lock_is_held_for_whole_periods_though_they_do_not_divide_in_floats(dark, at):
    optics = SimpleNamespace(field_of_view_rad=1e-3, every=1)
    loop = SimpleNamespace(timing=SimpleNamespace(period_s=0.1), optical=optics)  # 0.3 s of them are 2.9999999999999996
    sampler = SimpleNamespace(settings=SimpleNamespace(hold_s=0.3), loop=loop)
    time, margin = 0.1 * np.arange(12.0), np.ones(12)
    margin[5 : 5 + dark] = -1.0
    ends = Sight(np.array([2e7, 2.9e7]), np.zeros(2), np.zeros(2))
    loss, kept = Sampler._loss(sampler, time, 1e-6 * np.arange(12.0), margin, ends, 0)
    if at is None:
        assert (loss, kept) == (None, 12)
        return
    assert [loss.since_s, loss.time_s, loss.known_s, kept] == pytest.approx(list(at), rel=1e-9)
    assert loss.cause == "margin below 0 dB for 400 ms at 0.500 s: 8 µrad off, range 23800 km"


RUN = Settings(1.5, 0.25, 3, 0.5, 0.125, 0.0625, 7, 2)


@pytest.mark.parametrize(("found", "expected"), [
    (lambda: Contact(5.0, 5.0, "", "", 0.0, None),
     "a contact from 5 s to 5 s has no length: its end must be finite and come after its begin"),
    (lambda: Contact(5.0, 9.0, "", "", 5.5, None),
     "free_from_s is 5.5 s, and the contact begins at 5 s: it must be finite and no later; where the body is "
     "busy for longer, let the contact begin later"),
    (lambda: replace(RUN, slew_angle_rad=3.25),
     "slew_angle_rad of a contact run is 3.25: it must be finite and from 0 to pi rad"),
    (lambda: replace(RUN, slew_rate_rad_s=0.0),
     "slew_rate_rad_s of a contact run is 0: it must be finite and above 0 rad/s"),
    (lambda: replace(RUN, windows=100_001),
     "windows of a contact run is 100001: it must be finite and from 1 to 100000"),
    (lambda: replace(RUN, window_s=math.inf), "window_s of a contact run is inf: it must be finite and above 0 s"),
    (lambda: replace(RUN, settle_s=-1.0), "settle_s of a contact run is -1: it must be finite and at least 0 s"),
    (lambda: replace(RUN, hold_s=0.5),
     "hold_s of a contact run is 0.5: it must be finite and at least 0 s and below window_s (500 ms): a window "
     "shows no loss that takes longer"),
    (lambda: replace(RUN, seed=-1), "seed of a contact run is -1: it must be finite and from 0 to 2^63 - 1"),
    (lambda: replace(RUN, way="beacon"), 'way of a contact run is "beacon": it must be "wide beacon" or "scan"'),
])  # fmt: skip
def test_a_refusal_of_a_contact_is_one_whole_sentence(found, expected):
    with pytest.raises((ValueError, ArithmeticError)) as refused:
        found()
    assert str(refused.value) == expected


@pytest.mark.parametrize(("found", "expected"), [
    (lambda: [x for each in plan(100.0, 100.25, RUN) for x in each], "100 0.25"),
    (lambda: [x for each in plan(100.0, 101.25, RUN) for x in each], "100 0.5 100.75 0.5"),
    (lambda: [x for each in plan(100.0, 900.0, RUN) for x in each], "100 0.5 499.75 0.5 899.5 0.5"),
    (lambda: MovingReference(3e-6, 2e-5, 1.7, point_ahead_rate_rad_s=-4e-7, acceleration_rad_s2=6e-7).at([0.0, 2.5]),
     "4.86715221e-06 4.00758304e-06"),
    (lambda: [b for b, _ in plan(0.0, 0.3, replace(RUN, windows=3, window_s=0.1, hold_s=0.01))], "0 0.1 0.2"),
])  # fmt: skip
def test_plans_and_references_at_their_edges_have_these_numbers(found, expected):
    assert list(found()) == pytest.approx([float(each) for each in expected.split()], rel=1e-6, abs=0.0, nan_ok=True)
