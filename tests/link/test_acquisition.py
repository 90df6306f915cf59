"""The sequence of beacon, answer and lock with its retries, and the wide beacon against the scan."""

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from microrad.link.acquisition.detection import detection_times
from microrad.link.acquisition.scan import Detector, Search, Spiral
from microrad.link.acquisition.sequence import (
    LOCKED,
    LOST,
    Chances,
    Stage,
    Timing,
    answer_stages,
    beacon_stages,
    frame_detection_probability,
    frames_detection_probability,
    paper_sequence,
    scan_stages,
    simulate,
    simulate_log,
    solve_sequence,
)
from microrad.link.acquisition.times import TimeDistribution
from microrad.link.acquisition.trade import Beams, Receiver, wide_against_scan

URAD = 1e-6
NORMAL_99 = 2.5758  # one seed in a hundred misses it; larger studies of each pair show no bias
TIMING = Timing(
    range_m=44_000e3,
    body_settling_s=20.0,
    frame_time_s=0.1,
    frames=5,
    geo_response_s=3.0,
    leo_detection_s=0.5,
    mirror_settling_s=0.01,
    lock_time_s=1.0,
)
CHANCES = Chances(0.57, 0.9, 0.95, 0.99, 0.97, 0.98)


def test_a_time_distribution_keeps_its_books():
    times = TimeDistribution(np.array([1.0, 3.0, 4.0]), np.array([0.2, 0.3, 0.1]))
    assert times.probability == pytest.approx(0.6)
    assert times.mean_s == pytest.approx((0.2 + 0.9 + 0.4) / 0.6)
    assert times.std_s == pytest.approx(math.sqrt((0.2 + 2.7 + 1.6) / 0.6 - (1.5 / 0.6) ** 2))
    assert [times.cumulative(t) for t in (0.9, 1.0, 3.5, 9.0)] == pytest.approx([0.0, 0.2, 0.5, 0.6])
    assert [times.quantile(p) for p in (0.01, 0.2, 0.21, 0.5, 0.6)] == [1.0, 1.0, 3.0, 3.0, 4.0]
    both = times.followed_by(TimeDistribution(np.array([10.0, 12.0]), np.array([0.5, 0.25])))
    assert both.time_s == pytest.approx([11, 13, 14, 15, 16])
    assert both.weight == pytest.approx([0.1, 0.15 + 0.05, 0.05, 0.075, 0.025])


def test_convolving_long_lists_keeps_probability_and_mean():
    draw = np.random.Generator(np.random.Philox(key=1))
    one = TimeDistribution(np.sort(draw.random(3000)), np.full(3000, 1 / 4000))
    two = TimeDistribution(np.sort(draw.random(2500) * 5.0), np.full(2500, 1 / 2500))
    both = one.followed_by(two)
    assert both.probability == pytest.approx(0.75, rel=1e-9)
    assert both.mean_s == pytest.approx(one.mean_s + two.mean_s, rel=1e-9)
    assert both.std_s == pytest.approx(math.hypot(one.std_s, two.std_s), rel=1e-5)
    assert both.time_s.size <= 4096


def test_frames_detect_by_the_gaussian_tail():
    assert frame_detection_probability(6.0, 4.0) == pytest.approx(stats.norm.sf(4.0 - 6.0), rel=1e-12)
    assert frame_detection_probability(0.0, 4.0) == pytest.approx(stats.norm.sf(4.0), rel=1e-12)
    assert frames_detection_probability(0.9, 3) == pytest.approx(0.999, rel=1e-12)


@pytest.mark.promise("link-45", "link-48")
def test_the_papers_sequence_has_its_order_and_its_light_times():
    stages = paper_sequence(TIMING, CHANCES)
    assert [stage.name for stage in stages] == [
        "LEO points the beacon",
        "beacon travels",
        "GEO detects",
        "GEO turns and answers",
        "answer travels",
        "LEO detects the answer",
        "LEO's mirror turns",
        "narrow beam travels",
        "GEO locks",
        "GEO's beam travels",
        "LEO locks",
    ]
    light = 44e6 / 299_792_458
    assert TIMING.light_time_s == pytest.approx(light, rel=1e-14)
    sure = solve_sequence(paper_sequence(TIMING, Chances(1, 1, 1, 1, 1, 1)), 1)
    assert sure.success_probability == 1.0 and sure.lost.probability == 0.0
    assert sure.locked.time_s == pytest.approx([20 + 0.5 + 3 + 0.5 + 0.01 + 2 * 1.0 + 4 * light], rel=1e-12)
    assert stages[2].success_probability == pytest.approx(0.57 * (1 - 0.1**5), rel=1e-12)


def test_stages_call_the_terminals_by_their_names():
    named = replace(TIMING, own_name="OICETS", partner_name="ARTEMIS")
    chain = paper_sequence(named, CHANCES)
    for stage, usual in zip(chain, paper_sequence(TIMING, CHANCES), strict=True):
        assert stage.name == usual.name.replace("LEO", "OICETS").replace("GEO", "ARTEMIS")
        assert stage.on_failure == usual.on_failure.replace("LEO", "OICETS").replace("GEO", "ARTEMIS")
    scan = scan_stages(named, TimeDistribution(np.array([1.0]), np.array([0.5])), 2.0)
    assert [s.name for s in scan] == ["OICETS points the scan", "beam travels", "ARTEMIS detects"]
    assert scan[2].on_failure == scan[0].name
    assert (
        solve_sequence(chain, 3).success_probability
        == solve_sequence(paper_sequence(TIMING, CHANCES), 3).success_probability
    )


def test_frames_do_not_help_a_beacon_that_does_not_land():
    many = replace(TIMING, frames=1000)
    assert beacon_stages(many, CHANCES)[-1].success_probability == pytest.approx(0.57, rel=1e-12)


def by_matrix(stages, attempts):
    """Probability and mean time of lock from the fundamental matrix of the absorbing chain."""
    names, size = [s.name for s in stages], len(stages)
    states = size * attempts
    move, time, lock = np.zeros((states, states)), np.zeros((states, states)), np.zeros(states)
    lock_time = np.zeros(states)
    for used in range(attempts):
        for k, stage in enumerate(stages):
            here, p = used * size + k, stage.success_probability
            if k + 1 < size:
                move[here, here + 1], time[here, here + 1] = p, stage.duration_s
            else:
                lock[here], lock_time[here] = p, stage.duration_s
            if used + 1 < attempts:
                to = (used + 1) * size + (names.index(stage.on_failure) if stage.on_failure else k)
                move[here, to], time[here, to] = 1 - p, stage.failure_s
    fundamental = np.linalg.inv(np.eye(states) - move)
    reach = fundamental @ lock
    moment = fundamental @ ((move * time) @ reach + lock * lock_time)
    return reach[0], moment[0] / reach[0]


@pytest.mark.promise("link-45", "link-46")
@pytest.mark.parametrize("attempts", [1, 2, 5])
def test_the_solution_is_that_of_the_absorbing_chain(attempts):
    stages = paper_sequence(TIMING, CHANCES)
    outcome = solve_sequence(stages, attempts)
    probability, mean = by_matrix(stages, attempts)
    assert outcome.success_probability == pytest.approx(probability, rel=1e-12)
    assert outcome.mean_time_s == pytest.approx(mean, rel=1e-10)
    assert outcome.success_probability + outcome.lost.probability == pytest.approx(1.0, rel=1e-12)


def test_times_are_exact_for_one_stage_that_is_repeated():
    outcome = solve_sequence([Stage("try", 2.0, 0.25, 5.0)], 4)
    assert outcome.locked.time_s == pytest.approx([2, 7, 12, 17], rel=1e-14)
    assert outcome.locked.weight == pytest.approx([0.25 * 0.75**k for k in range(4)], rel=1e-14)
    assert outcome.lost.time_s == pytest.approx([20.0]) and outcome.lost.weight == pytest.approx([0.75**4])


@pytest.mark.promise("readme-7")
@pytest.mark.promise("link-45")
def test_the_sequence_and_its_simulation_agree():
    stages, attempts, runs = paper_sequence(TIMING, CHANCES), 4, 20_000
    outcome, drawn = solve_sequence(stages, attempts), simulate(stages, attempts, runs, seed=100)
    p = outcome.success_probability
    assert abs(drawn.locked.mean() - p) <= NORMAL_99 * math.sqrt(p * (1 - p) / runs)
    locked, lost = drawn.time_s[drawn.locked], drawn.time_s[~drawn.locked]
    assert abs(locked.mean() - outcome.mean_time_s) <= NORMAL_99 * locked.std() / math.sqrt(locked.size)
    assert abs(lost.mean() - outcome.lost.mean_s) <= NORMAL_99 * lost.std() / math.sqrt(lost.size)
    assert locked.std() == pytest.approx(outcome.locked.std_s, rel=0.05)
    for time in (30.0, 60.0, 80.0):
        q = outcome.locked.cumulative(time)
        assert abs(np.mean(drawn.locked & (drawn.time_s <= time + 1e-6)) - q) <= NORMAL_99 * math.sqrt(
            q * (1 - q) / runs
        )


def test_a_scan_takes_the_place_of_the_beacon():
    scan = Spiral(Search(300 * URAD, 20 * URAD, 0.25, 0.9), Detector(2e-3, 0.9), 8e-3)
    times = detection_times(scan)
    stages = (*scan_stages(TIMING, times, scan.duration_s), *answer_stages(TIMING, CHANCES))
    outcome, runs = solve_sequence(stages, 3), 8000
    drawn = simulate(stages, 3, runs, seed=9)
    p = outcome.success_probability
    assert abs(drawn.locked.mean() - p) <= NORMAL_99 * math.sqrt(p * (1 - p) / runs)
    locked = drawn.time_s[drawn.locked]
    assert abs(locked.mean() - outcome.mean_time_s) <= NORMAL_99 * locked.std() / math.sqrt(locked.size)
    first = solve_sequence(stages, 1)
    rest = 20 + 3 + 0.5 + 0.01 + 2.0 + 4 * TIMING.light_time_s
    assert first.mean_time_s == pytest.approx(times.mean_s + rest, rel=1e-9)
    assert first.success_probability == pytest.approx(times.probability * 0.95 * 0.99 * 0.97 * 0.98**2, rel=1e-9)


def test_a_log_tells_each_step_and_its_cause():
    stages = paper_sequence(TIMING, CHANCES)
    drawn = simulate(stages, 2, 1, seed=3)
    log = simulate_log(stages, 2, seed=3)
    assert log[0].stage == stages[0].name and log[0].time_s == 20.0 and log[0].cause == "done"
    assert log[-1].to == (LOCKED if drawn.locked[0] else LOST) and log[-1].time_s == drawn.time_s[0]
    for event, following in itertools.pairwise(log):
        assert event.to == following.stage and event.time_s <= following.time_s
    failing = simulate_log([Stage("point", 1.0), Stage("see", 2.0, 1e-9, 4.0, "point")], 2, seed=1)
    assert [(e.time_s, e.stage, e.to, e.cause) for e in failing] == [
        (1.0, "point", "see", "done"),
        (5.0, "see", "point", "time-out, failure 1 of 2"),
        (6.0, "point", "see", "done"),
        (10.0, "see", LOST, "time-out, failure 2 of 2"),
    ]


BEAMS = Beams(4.0, 44_000e3, 25 * URAD, 20 * URAD, 0.25)
THERMAL = Receiver(math.pi / 4 * 0.15**2, 6e-10, 1.0)


def test_irradiance_is_that_of_a_gaussian_beam_and_holds_its_power():
    # 4 W, 780 urad full angle at 1/e2, 44 000 km, and 0.4 dB of Strehl ratio 300 urad off the axis
    on_axis, off_axis = BEAMS.irradiance_w_m2(390 * URAD, [0.0, 300 * URAD]) * 1e9
    assert on_axis == pytest.approx(8.65, abs=0.005)
    assert off_axis * 10**-0.04 == pytest.approx(2.42, abs=0.006)
    radius = np.linspace(0.0, 2e-3, 20_001) * 44_000e3
    ring = BEAMS.irradiance_w_m2(390 * URAD, radius / 44_000e3) * 2 * math.pi * radius
    assert np.trapezoid(ring, radius) == pytest.approx(4.0, rel=1e-6)


@pytest.mark.promise("link-53")
def test_detection_time_follows_the_noise():
    # ratio 6 of signal to rms noise, 1e-10 W of noise in a second
    power = np.array([1e-10, 2e-10])
    assert power * np.sqrt(THERMAL.detection_time_s(power)) / 1e-10 == pytest.approx([6.0, 6.0])
    assert THERMAL.detection_time_s(6e-10) == pytest.approx(1.0)
    assert replace(THERMAL, shortest_s=40.0).detection_time_s(power) == pytest.approx([40.0, 40.0])


def test_the_wide_beacon_grows_with_the_fourth_power_of_the_uncertainty_and_the_scan_with_the_second():
    sigma = np.array([100.0, 200.0, 400.0]) * URAD
    trade = wide_against_scan(sigma, 0.99, BEAMS, THERMAL)
    assert trade.wide_time_s[1:] / trade.wide_time_s[:-1] == pytest.approx([16.0, 16.0], rel=1e-9)
    assert trade.scan_time_s[1:] / trade.scan_time_s[:-1] == pytest.approx([4.0, 4.0], rel=1e-9)
    assert np.all(trade.scan_mean_time_s < trade.scan_time_s / 3)
    assert trade.scan_probability == pytest.approx(trade.wide_probability, abs=2e-3)
    assert trade.radius_rad == pytest.approx(sigma * math.sqrt(-2 * math.log(0.01)), rel=1e-12)
    assert trade.wide_full_angle_rad == pytest.approx(2 * math.sqrt(2) * trade.radius_rad, rel=1e-12)
    assert np.all(np.diff(trade.wide_time_s / trade.scan_time_s) > 0)  # the wider, the more the scan pays


def test_the_scan_is_as_fast_as_its_worst_covered_target_allows():
    trade = wide_against_scan(300 * URAD, 0.99, BEAMS, THERMAL)
    edge = math.pi / 4 * 0.15**2 * 2 * 4.0 / (math.pi * (25e-6 * 44e6) ** 2) * math.exp(-2 * (20 / 25) ** 2)
    detection = (6.0 * 1e-10 / edge) ** 2
    assert trade.speed_rad_s == pytest.approx(2 * math.sqrt(20**2 - 15**2) * URAD / detection, rel=1e-12)
    assert trade.scan_time_s[0] == pytest.approx(
        math.pi * trade.radius_rad[0] ** 2 / (30 * URAD * trade.speed_rad_s), rel=1e-12
    )
    shaken = wide_against_scan(300 * URAD, 0.99, BEAMS, THERMAL, jitter_rms_rad=8 * URAD)
    assert shaken.scan_probability[0] < trade.scan_probability[0] - 0.02


def test_the_wide_beams_edge_is_brightest_at_the_root_of_two():
    trade = wide_against_scan(300 * URAD, 0.99, BEAMS, THERMAL)
    radius, area = trade.radius_rad[0], math.pi / 4 * 0.15**2
    halves = radius * np.array([1.0, 1.3, 1.4, math.sqrt(2), 1.43, 1.55])
    times = THERMAL.detection_time_s(area * BEAMS.irradiance_w_m2(halves, radius))
    assert np.argmin(times) == 3
    assert trade.wide_time_s[0] == pytest.approx(times[3], rel=1e-12)


ONE = TimeDistribution(np.array([1.0]), np.array([0.5]))
STAGE = Stage("see", 1.0, 0.5)
REFUSALS = [
    (lambda: ONE.quantile(0.51), r"no time has the probability 0\.51: .*at most 0\.5"),
    (lambda: ONE.quantile(0.0), r"no time has the probability 0: it must lie above 0"),
    (lambda: ONE.scaled(0.0).mean_s, r"no time of success: its probability is 0"),
    (lambda: frame_detection_probability(-1.0, 3.0), r"the signal-to-noise ratio is -1: it must be finite, at least 0"),
    (lambda: frame_detection_probability(1.0, math.inf), r"the threshold is inf times the noise: it must be finite"),
    (
        lambda: frames_detection_probability(0.0, 3),
        r"the probability of detection in a frame is 0: it must be finite, above 0, at most 1",
    ),
    (lambda: frames_detection_probability(0.5, 0), r"the number of frames is 0: it must be finite, at least 1"),
    (lambda: Stage("see", -1.0), r'the duration of the stage "see" is -1 s: it must be finite, at least 0 s'),
    (lambda: Stage("see", 1.0, 0.0), r'the probability of success of the stage "see" is 0: it must be finite, above 0'),
    (lambda: Stage("see", 1.0, 1.1), r'success of the stage "see" is 1\.1'),
    (lambda: Stage("see", 2.0, 0.5, 1.5), r'"see" lasts 2 s and its time-out is 1\.5 s: .* must not be shorter'),
    (lambda: Stage("see", 2.0, 0.5, math.inf), r'the time-out of the stage "see" is inf s'),
    (lambda: replace(TIMING, range_m=0.0), r"Timing\.range_m is 0 m: it must be finite, above 0 m"),
    (lambda: replace(TIMING, frames=0), r"Timing\.frames is 0: it must be finite, at least 1"),
    (lambda: replace(TIMING, frame_time_s=0.0), r"Timing\.frame_time_s is 0 s: it must be finite, above 0 s"),
    (lambda: replace(TIMING, geo_response_s=-1.0), r"Timing\.geo_response_s is -1 s: it must be finite, at least 0 s"),
    (
        lambda: replace(CHANCES, return_coverage=1.2),
        r"Chances\.return_coverage is 1\.2: it must be finite, above 0, at most 1",
    ),
    (lambda: solve_sequence([STAGE], 0), r"the number of attempts is 0: it must be finite, at least 1"),
    (lambda: solve_sequence([], 1), r"the sequence has no stage"),
    (lambda: solve_sequence([STAGE, STAGE], 1), r"two stages have the same name among see, see"),
    (
        lambda: solve_sequence([replace(STAGE, on_failure="lock"), Stage("lock", 1.0)], 1),
        r'"see" goes back to "lock" on failure: it must be itself or an earlier stage, one of see',
    ),
    (lambda: simulate([STAGE], 1, 0, 1), r"the number of runs is 0"),
    (lambda: simulate([STAGE], 0, 1, 1), r"the number of attempts is 0"),
    (lambda: replace(BEAMS, power_w=0.0), r"Beams\.power_w is 0 W: it must be finite, above 0 W"),
    (lambda: replace(BEAMS, overlap=-0.1), r"Beams\.overlap is -0\.1: it must be finite, at least 0 and below 1"),
    (lambda: replace(BEAMS, overlap=1.0), r"Beams\.overlap is 1: it must be finite, at least 0 and below 1"),
    (
        lambda: wide_against_scan(3e-4, 0.99, replace(BEAMS, overlap=0.0), THERMAL),
        r"the overlap is 0: it must be above 0, or a target between two tracks is seen for no time",
    ),
    (
        lambda: replace(BEAMS, beam_radius_rad=0.0),
        r"Beams\.beam_radius_rad is 0 rad: it must be finite, above 0 and below 1\.571 rad",
    ),
    (
        lambda: replace(BEAMS, narrow_half_angle_rad=2.0),
        r"Beams\.narrow_half_angle_rad is 2 rad: it must be finite, above 0 and below 1\.571 rad",
    ),
    (lambda: replace(THERMAL, power_w=0.0), r"Receiver\.power_w is 0 W: it must be finite, above 0 W"),
    (lambda: replace(THERMAL, time_s=0.0), r"Receiver\.time_s is 0 s: it must be finite, above 0 s"),
    (lambda: replace(THERMAL, shortest_s=-1.0), r"Receiver\.shortest_s is -1 s: it must be finite, at least 0 s"),
    (
        lambda: wide_against_scan(3e-4, 1.0, BEAMS, THERMAL),
        r"Search\.coverage is 1: it must be finite, above 0 and below 1",
    ),
]


@pytest.mark.parametrize(("call", "message"), REFUSALS)
def test_what_no_acquisition_has_is_refused_with_the_limit(call, message):
    with pytest.raises(ValueError, match=message):
        call()
