"""The sequence of beacon, answer and lock with its retries, and the wide beacon against the scan."""

import itertools
import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy import stats

from microrad.link.acquisition import partner_search
from microrad.link.acquisition.detection import detection_times
from microrad.link.acquisition.scan import Detector, Search, Spiral
from microrad.link.acquisition.sequence import (
    LOCKED,
    LOST,
    Chances,
    Outcome,
    SequenceRuns,
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
from microrad.link.acquisition.times import TimeDistribution, fixed_time, joined, merged
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


@pytest.mark.parametrize(
    ("call", "error", "words"),
    [
        (
            lambda: Stage("GEO detects", 2.5, 0.75, 0.125),
            ValueError,
            ('the stage "GEO detects" lasts 2.5 s and its time-out is 125 ms: the time-out must not be shorter'),
        ),
        (
            lambda: Stage("GEO turns", TimeDistribution(np.array([1.0, 4.5]), np.array([0.5, 0.25])), 0.5, 3.25),
            ValueError,
            ('the stage "GEO turns" lasts 4.5 s and its time-out is 3.25 s: the time-out must not be shorter'),
        ),
        (
            lambda: Stage("LEO locks", 1.5, 1.25),
            ValueError,
            ('the probability of success of the stage "LEO locks" is 1.25: it must be finite, above 0, at most 1'),
        ),
        (
            lambda: Stage("LEO locks", -1.5),
            ValueError,
            'the duration of the stage "LEO locks" is -1.5 s: it must be finite, at least 0 s',
        ),
        (
            lambda: Stage("LEO locks", 1.5, 0.5, math.inf),
            ValueError,
            'the time-out of the stage "LEO locks" is inf s: it must be finite, at least 0 s',
        ),
        (
            lambda: solve_sequence((Stage("a", 1.0), Stage("b", 2.0, 0.5, on_failure="c"), Stage("c", 3.0)), 4),
            ValueError,
            '"b" goes back to "c" on failure: it must be itself or an earlier stage, one of a, b',
        ),
        (
            lambda: solve_sequence((Stage("a", 1.0), Stage("b", 2.0), Stage("a", 3.0)), 4),
            ValueError,
            "two stages have the same name among a, b, a: name each differently",
        ),
        (lambda: solve_sequence((), 4), ValueError, "the sequence has no stage: give at least one"),
        (
            lambda: simulate((Stage("a", 1.0),), 2, 0, seed=5),
            ValueError,
            "the number of runs is 0: it must be finite, at least 1",
        ),
        (
            lambda: frame_detection_probability(3.5, math.inf),
            ValueError,
            "the threshold is inf times the noise: it must be finite",
        ),
        (
            lambda: frame_detection_probability(-3.5, 5.0),
            ValueError,
            "the signal-to-noise ratio is -3.5: it must be finite, at least 0",
        ),
        (
            lambda: frames_detection_probability(0.25, 0),
            ValueError,
            "the number of frames is 0: it must be finite, at least 1",
        ),
        (
            lambda: TimeDistribution(np.array([1.0, 3.0]), np.array([0.25, 0.375])).quantile(0.75),
            ValueError,
            ("no time has the probability 0.75: it must lie above 0 and be at most 0.625, the probability of success"),
        ),
        (
            lambda: TimeDistribution(np.array([1.0, 3.0]), np.array([0.0, 0.0])).given_success(),
            ValueError,
            "there is no time of success: its probability is 0; lengthen the time-out or the coverage",
        ),
        (
            lambda: wide_against_scan(
                [2e-4, 3e-4], 0.9, Beams(1.5, 4e7, 2e-5, 1.5e-5, 0.0), Receiver(0.05, 1e-10, 0.01)
            ),
            ValueError,
            "the overlap is 0: it must be above 0, or a target between two tracks is seen for no time",
        ),
    ],
)
def test_a_refusal_of_times_and_stages_says_every_number_and_name(call, error, words):
    with pytest.raises(error) as refused:
        call()
    assert str(refused.value) == words


OTHER = replace(TIMING, range_m=39e6, body_settling_s=7.0, frame_time_s=0.25, frames=3, geo_response_s=1.75)
UNLIKE = Chances(0.61, 0.83, 0.92, 0.87, 0.79, 0.94)
TIMES = TimeDistribution(np.array([1.5, 4.0, 7.25]), np.array([0.125, 0.25, 0.375]))


@pytest.mark.parametrize(
    ("found", "expected"),
    [
        (
            lambda: [each.success_probability for each in paper_sequence(OTHER, UNLIKE)],
            [1.0, 1.0, 0.60700307, 1.0, 1.0, 0.8004, 1.0, 1.0, 0.7426, 1.0, 0.94],
        ),
        (
            lambda: [each.longest_s for each in paper_sequence(OTHER, UNLIKE)],
            [7.0, 0.130089997, 0.75, 1.75, 0.130089997, 0.5, 0.01, 0.130089997, 1.0, 0.130089997, 1.0],
        ),
        (
            lambda: [each.failure_s for each in paper_sequence(OTHER, UNLIKE)],
            [7.0, 0.130089997, 3.13009, 1.75, 0.130089997, 0.630089997, 0.01, 0.130089997, 1.13009, 0.130089997, 1.0],
        ),
        (
            lambda: [
                scan_stages(OTHER, TIMES, 9.5)[2].success_probability,
                scan_stages(OTHER, TIMES, 9.5)[2].failure_s,
                scan_stages(OTHER, TIMES, 9.5)[2].longest_s,
            ],
            [0.75, 11.88009, 7.25],
        ),
        (
            lambda: [
                scan_stages(OTHER, TIMES.scaled(1.5), 9.5)[2].success_probability,
                scan_stages(OTHER, TIMES, 9.5)[0].longest_s,
            ],
            [1.0, 7.0],
        ),
        (
            lambda: [
                (o := solve_sequence(paper_sequence(OTHER, UNLIKE), 3)).success_probability,
                o.lost.probability,
                o.mean_time_s,
                o.lost.mean_s,
                o.locked.std_s,
                o.locked.quantile(0.25),
            ],
            [0.79931752, 0.20068248, 17.2720886, 25.2967053, 6.04984526, 12.53036],
        ),
        (
            lambda: [
                (
                    o := solve_sequence((Stage("a", TIMES, 0.5, 8.0), Stage("b", 2.5, 0.75, 3.5, "a")), 2)
                ).success_probability,
                *o.locked.time_s,
                *o.locked.weight,
                *o.lost.time_s,
                *o.lost.weight,
            ],
            [
                0.609375,
                4.0,
                6.5,
                9.0,
                9.75,
                11.5,
                12.0,
                14.0,
                14.5,
                14.75,
                17.25,
                17.75,
                20.5,
                0.0625,
                0.125,
                0.00130208333,
                0.1875,
                0.00520833333,
                0.03125,
                0.00520833333,
                0.0625,
                0.0078125,
                0.015625,
                0.09375,
                0.01171875,
                10.0,
                12.5,
                13.0,
                15.0,
                15.5,
                15.75,
                16.0,
                18.25,
                18.75,
                21.5,
                0.000434027778,
                0.00173611111,
                0.0208333333,
                0.00173611111,
                0.0416666667,
                0.00260416667,
                0.25,
                0.00520833333,
                0.0625,
                0.00390625,
            ],
        ),
        (
            lambda: [
                TIMES.probability,
                TIMES.mean_s,
                TIMES.std_s,
                TIMES.cumulative(4.0),
                TIMES.quantile(0.3),
                *TIMES.given_success().weight,
                *TIMES.shifted(2.5).time_s,
            ],
            [0.75, 5.20833333, 2.20518644, 0.375, 4.0, 0.166666667, 0.333333333, 0.5, 4.0, 6.5, 9.75],
        ),
        (
            lambda: [
                *TIMES.followed_by(fixed_time(0.5, 0.75)).time_s,
                *TIMES.followed_by(fixed_time(0.5, 0.75)).weight,
            ],
            [2.0, 4.5, 7.75, 0.09375, 0.1875, 0.28125],
        ),
        (
            lambda: [
                *joined([TIMES, fixed_time(4.0, 0.1), TIMES.shifted(2.5)]).time_s,
                *joined([TIMES, fixed_time(4.0, 0.1), TIMES.shifted(2.5)]).weight,
            ],
            [1.5, 4.0, 6.5, 7.25, 9.75, 0.125, 0.475, 0.25, 0.375, 0.375],
        ),
        (
            lambda: [frame_detection_probability(3.5, 5.25), frames_detection_probability(0.3, 4)],
            [0.0400591569, 0.7599],
        ),
        (
            lambda: [
                Beams(1.5, 4e7, 2e-5, 1.5e-5, 0.3).edge_irradiance_w_m2,
                *Beams(1.5, 4e7, 2e-5, 1.5e-5, 0.3).irradiance_w_m2([1e-5, 3e-5], [4e-6, 7e-6]),
            ],
            [4.84406672e-07, 4.33388283e-06, 5.94728905e-07],
        ),
        (
            lambda: [*Receiver(0.05, 2e-10, 0.03, 0.002).detection_time_s([1e-10, 2e-10, 4e-10, 9e-10])],
            [0.12, 0.03, 0.0075, 0.002],
        ),
        (
            lambda: [
                x
                for name in (
                    "radius_rad",
                    "wide_full_angle_rad",
                    "wide_time_s",
                    "wide_probability",
                    "scan_time_s",
                    "scan_mean_time_s",
                    "scan_probability",
                )
                for x in getattr(
                    wide_against_scan(
                        [9e-5, 5e-5], 0.9, Beams(1.5, 4e7, 2e-5, 1.5e-5, 0.3), Receiver(0.05, 2e-10, 0.03, 0.002), 2e-6
                    ),
                    name,
                )
            ],
            [
                0.000193136942,
                0.000107298301,
                0.000546273767,
                0.000303485426,
                0.0554177387,
                0.00527908652,
                0.9,
                0.9,
                0.520936675,
                0.160782925,
                0.167188868,
                0.0512877867,
                0.852220953,
                0.851600769,
            ],
        ),
    ],
)
def test_times_chances_and_trades_of_numbers_unlike_each_other(found, expected):
    assert list(found()) == pytest.approx(expected, rel=1e-6, abs=0.0, nan_ok=True)


TWO = TimeDistribution(np.array([1.0, 2.5]), np.array([0.3, 0.5]))
CHAIN = (Stage("turn", 1.5, 0.9, 2.25), Stage("look", TWO, 0.7, 4.0, "turn"), Stage("lock", 0.5, 0.8, 0.75, "look"))
PACE = Timing(4.1e7, 3.0, 0.07, 4, 1.3, 0.9, 0.2, 0.11, "own", "other")
LUCK = Chances(0.91, 0.37, 0.83, 0.76, 0.68, 0.97)


@pytest.mark.parametrize(("found", "expected"), [
    (lambda: [*(t := merged(np.array([3.0, 1.0, 1.0 + 5e-10, 2.0]), np.array([0.1, 0.2, 0.3, 0.0]))).time_s, *t.weight],
     "1 3 0.5 0.1"),
    (lambda: [*(t := merged(np.arange(9.0), np.arange(9.0), 3)).time_s, *t.weight],
     "2.33333333 4.55555556 7.0952381 6 9 21"),
    (lambda: [merged(np.zeros(3), np.zeros(3)).probability, merged(np.zeros(3), np.zeros(3)).time_s.size], "0 0"),
    (lambda: [(t := TimeDistribution(np.array([1.0, 2.5, 7.0]), np.array([0.1, 0.25, 0.4]))).mean_s, t.std_s,
            t.probability],
     "4.7 2.5019992 0.75"),
    (lambda: [TimeDistribution(np.array([1.0, 2.5, 7.0]), np.array([0.1, 0.25, 0.4])).quantile(p) for p in (0.05, 0.1,
            0.11, 0.75)],
     "1 1 2.5 7"),
    (lambda: [TimeDistribution(np.array([1.0, 2.5]), np.array([0.1, 0.25])).cumulative(x) for x in (0.9, 1.0, 2.5, 2.5
            - 1e-9, 9.0)],
     "0 0.1 0.35 0.35 0.35"),
    (lambda: [*(t := fixed_time(2.0, 0.6).followed_by(fixed_time(0.5, 0.25))).time_s, *t.weight], "2.5 0.15"),
    (lambda: [*(t := joined([fixed_time(2.0, 0.6), fixed_time(0.5, 0.25), fixed_time(2.0, 0.1)])).time_s, *t.weight],
     "0.5 2 0.25 0.7"),
    (lambda: [*(t := TWO.shifted(1.5).scaled(0.5).given_success()).time_s, *t.weight], "2.5 4 0.375 0.625"),
    (lambda: [*(t := TWO.followed_by(TWO.shifted(0.25))).time_s, *t.weight], "2.25 3.75 5.25 0.09 0.3 0.25"),
    (lambda: [(s := Stage("a", TWO, 0.5)).longest_s, s.failure_s, *s.success_times.time_s, *s.success_times.weight],
     "2.5 2.5 1 2.5 0.1875 0.3125"),
    (lambda: [(s := Stage("a", 1.5, 0.5, 4.0)).longest_s, s.failure_s, *s.success_times.time_s,
            *s.success_times.weight],
     "1.5 4 1.5 0.5"),
    (lambda: [*(o := solve_sequence(CHAIN, 3)).locked.time_s, *o.locked.weight],
     "3 4.5 4.75 5.25 6.25 6.5 6.75 7 7.5 7.75 8 8.5 9 9.5 10 10.25 10.75 11 11.75 12.25 13.25 14 15.5 0.189 "
     "0.315 0.0099225 0.0189 0.033075 0.00052093125 0.0315 0.00099225 0.00189 0.0275625 0.00260465625 0.0543375 "
     "0.00315 0.00434109375 0.08780625 0.00535815 0.010206 0.00241171875 0.0178605 0.01701 0.01488375 0.0137781 "
     "0.0229635"),
    (lambda: [*(o := solve_sequence(CHAIN, 2)).lost.time_s, *o.lost.weight],
     "4.5 5 5.5 6.5 7 7.25 7.75 8 8.75 10.25 11 0.01 0.002480625 0.004725 0.00826875 0.007875 0.014175 0.054 "
     "0.006890625 0.0363825 0.0212625 0.0729"),
    (lambda: [(o := solve_sequence(CHAIN, 4)).success_probability, o.mean_time_s, o.lost.probability],
     "0.944733384 6.94852464 0.055266616"),
    (lambda: [*(r := simulate(CHAIN, 2, 12, 5)).locked, *r.time_s],
     "1 1 1 1 1 1 1 1 1 0 1 1 3 4.5 3 4.5 4.5 3 10 6.75 6.25 11 4.5 4.5"),
    (lambda: [x.time_s for x in simulate_log(CHAIN, 3, 11)], "1.5 4 4.5"),
    (lambda: [frame_detection_probability(*x) for x in ((0.0, 2.0), (7.0, 4.5), (1.0, -0.5))],
     "0.0227501319 0.993790335 0.933192799"),
    (lambda: [frames_detection_probability(0.3, n) for n in (1, 2, 7)], "0.3 0.51 0.9176457"),
    (lambda: [x for s in scan_stages(PACE, TWO, 9.0) for x in (s.longest_s, s.success_probability, s.failure_s)],
     "3 1 3 0.136761279 1 0.136761279 2.5 0.8 11.3367613"),
    (lambda: [x for s in beacon_stages(PACE, LUCK) for x in (s.longest_s, s.success_probability, s.failure_s)],
     "3 1 3 0.136761279 1 0.136761279 0.28 0.766648055 2.61676128"),
    (lambda: [x for s in answer_stages(PACE, LUCK) for x in (s.longest_s, s.success_probability, s.failure_s)],
     "1.3 1 1.3 0.136761279 1 0.136761279 0.9 0.6308 1.03676128 0.2 1 0.2 0.136761279 1 0.136761279 0.11 0.6596 "
     "0.246761279 0.136761279 1 0.136761279 0.11 0.97 0.11"),
    (lambda: Receiver(0.05, 2e-10, 0.03, 0.002).detection_time_s([1e-10, 2e-10, 9e-10]), "0.12 0.03 0.002"),
    (lambda: Receiver(0.05, 2e-10, 0.03).detection_time_s([4e-9]), "7.5e-05"),
    (lambda: Beams(1.5, 4e7, 2e-5, 1.5e-5, 0.3).irradiance_w_m2([1e-5, 3e-5], [0.0, 2e-5]),
     "5.96831037e-06 2.72627305e-07"),
    (lambda: [Beams(1.5, 4e7, 2e-5, 1.5e-5, 0.3).edge_irradiance_w_m2], "4.84406672e-07"),
    (lambda: [(t := wide_against_scan(6e-5, 0.8, Beams(1.5, 4e7, 2e-5, 1.5e-5, 0.3), Receiver(0.05, 2e-10,
            0.03))).speed_rad_s, *t.scan_probability, *t.wide_time_s, *t.sigma_rad],
     "10.4733432 0.797744158 0.00534811628 6e-05"),
])  # fmt: skip
def test_times_and_stages_at_their_edges_have_these_numbers(found, expected):
    assert list(found()) == pytest.approx([float(each) for each in expected.split()], rel=1e-6, abs=0.0, nan_ok=True)


@pytest.mark.parametrize(("found", "expected"), [
    (lambda: "; ".join(f"{x.stage} > {x.to}: {x.cause}" for x in simulate_log(CHAIN, 3, 11)),
     "turn > look: done; look > lock: done; lock > locked: done"),
    (lambda: "; ".join(f"{x.stage} > {x.to}: {x.cause}" for x in simulate_log(CHAIN, 1, 3)),
     "turn > lost: time-out, failure 1 of 1"),
    (lambda: "; ".join(f"{x.stage} > {x.to}: {x.cause}" for x in simulate_log(CHAIN, 2, 29)),
     "turn > look: done; look > turn: time-out, failure 1 of 2; turn > look: done; look > lock: done; lock > "
     "locked: done"),
    (lambda: "; ".join(f"{x.name} > {x.on_failure}" for x in paper_sequence(PACE, LUCK)),
     "own points the beacon > ; beacon travels > ; other detects > own points the beacon; other turns and "
     "answers > ; answer travels > ; own detects the answer > other turns and answers; own's mirror turns > ; "
     "narrow beam travels > ; other locks > own detects the answer; other's beam travels > ; own locks > own "
     "detects the answer"),
    (lambda: "; ".join(f"{x.name} > {x.on_failure}" for x in scan_stages(PACE, TWO, 9.0)),
     "own points the scan > ; beam travels > ; other detects > own points the scan"),
])  # fmt: skip
def test_stages_and_logs_name_each_step_and_where_it_leads(found, expected):
    assert found() == expected


@pytest.mark.parametrize(("found", "expected"), [
    (lambda: Stage("a", -1.0), 'the duration of the stage "a" is -1 s: it must be finite, at least 0 s'),
    (lambda: Stage("a", 1.0, 0.0),
     'the probability of success of the stage "a" is 0: it must be finite, above 0, at most 1'),
    (lambda: Stage("a", 1.0, 1.5),
     'the probability of success of the stage "a" is 1.5: it must be finite, above 0, at most 1'),
    (lambda: Stage("a", 1.0, 1.0, -2.0), 'the time-out of the stage "a" is -2 s: it must be finite, at least 0 s'),
    (lambda: Stage("a", TWO, 0.5, 2.4),
     'the stage "a" lasts 2.5 s and its time-out is 2.4 s: the time-out must not be shorter'),
    (lambda: Stage("a", math.inf), 'the duration of the stage "a" is inf s: it must be finite, at least 0 s'),
    (lambda: solve_sequence((), 1), "the sequence has no stage: give at least one"),
    (lambda: solve_sequence(CHAIN, 0), "the number of attempts is 0: it must be finite, at least 1"),
    (lambda: solve_sequence((CHAIN[0], CHAIN[0]), 2),
     "two stages have the same name among turn, turn: name each differently"),
    (lambda: solve_sequence((replace(CHAIN[0], on_failure="lock"), *CHAIN[1:]), 2),
     '"turn" goes back to "lock" on failure: it must be itself or an earlier stage, one of turn'),
    (lambda: simulate(CHAIN, 2, 0, 1), "the number of runs is 0: it must be finite, at least 1"),
    (lambda: simulate_log(CHAIN, 0, 1), "the number of attempts is 0: it must be finite, at least 1"),
    (lambda: Stage("a", 2.00001, 0.5, 2.0),
     'the stage "a" lasts 2.001 s and its time-out is 2 s: the time-out must not be shorter'),
    (lambda: Stage("a", 2.0, 0.5, 1.99999),
     'the stage "a" lasts 2 s and its time-out is 1.99999 s: the time-out must not be shorter'),
    (lambda: TWO.quantile(0.8000001),
     "no time has the probability 0.8000001: it must lie above 0 and be at most 0.8, the probability of success"),
    (lambda: TWO.scaled(0.7 / 0.8 * 0.99999).quantile(0.7),
     "no time has the probability 0.7: it must lie above 0 and be at most 0.6999, the probability of success"),
    (lambda: solve_sequence(CHAIN, 1.5), "the number of attempts is 1.5: it must be whole, at least 1"),
    (lambda: solve_sequence(CHAIN, math.nan), "the number of attempts is nan: it must be finite, at least 1"),
    (lambda: TWO.quantile(0.85),
     "no time has the probability 0.85: it must lie above 0 and be at most 0.8, the probability of success"),
    (lambda: TWO.quantile(-0.1),
     "no time has the probability -0.1: it must lie above 0 and be at most 0.8, the probability of success"),
    (lambda: TWO.scaled(0.0).mean_s,
     "there is no time of success: its probability is 0; lengthen the time-out or the coverage"),
    (lambda: fixed_time(-0.1), "a time is -100 ms: it must be finite, at least 0 s"),
    (lambda: frame_detection_probability(-1.0, 2.0), "the signal-to-noise ratio is -1: it must be finite, at least 0"),
    (lambda: frame_detection_probability(1.0, math.nan), "the threshold is nan times the noise: it must be finite"),
    (lambda: frames_detection_probability(0.0, 2),
     "the probability of detection in a frame is 0: it must be finite, above 0, at most 1"),
    (lambda: frames_detection_probability(0.5, 0), "the number of frames is 0: it must be finite, at least 1"),
    (lambda: replace(PACE, frames=0), "Timing.frames is 0: it must be finite, at least 1"),
    (lambda: replace(PACE, range_m=0.0), "Timing.range_m is 0 m: it must be finite, above 0 m"),
    (lambda: replace(PACE, lock_time_s=-0.1), "Timing.lock_time_s is -100 ms: it must be finite, at least 0 s"),
    (lambda: replace(LUCK, lock=1.01), "Chances.lock is 1.01: it must be finite, above 0, at most 1"),
    (lambda: Receiver(0.0, 1e-9, 0.1), "Receiver.aperture_area_m2 is 0 m^2: it must be finite, above 0 m^2"),
    (lambda: Receiver(0.1, 1e-9, 0.1, -1.0), "Receiver.shortest_s is -1 s: it must be finite, at least 0 s"),
    (lambda: Beams(0.0, 4e7, 2e-5, 1.5e-5, 0.3), "Beams.power_w is 0 W: it must be finite, above 0 W"),
    (lambda: Beams(1.0, 4e7, 1.6, 1.5e-5, 0.3),
     "Beams.narrow_half_angle_rad is 1.6 rad: it must be finite, above 0 and below 1.571 rad; an angle from the "
     "line of sight is meant"),
    (lambda: wide_against_scan(6e-5, 0.8, Beams(1.5, 4e7, 2e-5, 1.5e-5, 0.0), Receiver(0.05, 2e-10, 0.03)),
     "the overlap is 0: it must be above 0, or a target between two tracks is seen for no time"),
    (lambda: wide_against_scan(6e-5, 1.0, Beams(1.5, 4e7, 2e-5, 1.5e-5, 0.2), Receiver(0.05, 2e-10, 0.03)),
     "Search.coverage is 1: it must be finite, above 0 and below 1; Gaussian errors have no edge"),
])  # fmt: skip
def test_a_refusal_of_an_acquisition_is_one_whole_sentence(found, expected):
    with pytest.raises((ValueError, ArithmeticError)) as refused:
        found()
    assert str(refused.value) == expected


LOOKS = SimpleNamespace(measurement_s=0.3, sensor=SimpleNamespace(rate_hz=40.0), detection_probability=0.87)
FOUND = partner_search.Found(
    "scan", CHAIN, Outcome(TWO, TWO), SequenceRuns(np.array([True, False, True]), np.array([1.0, 9.0, 2.5])), ()
)


def replace_in(table, **changes):
    return SimpleNamespace(**{**vars(table), **changes})


@pytest.mark.parametrize(("found", "expected"), [
    (lambda: [partner_search._answer_detection(LOOKS, SimpleNamespace(signal_to_noise=x)) for x in (0.0, 1.3, 1.9)],
     "2.86651572e-07 0.309711631 0.943151591"),
    (lambda: [partner_search._answer_detection(replace_in(LOOKS, measurement_s=1e-3),
            SimpleNamespace(signal_to_noise=4.6))],
     "0.344578258"),
    (lambda: [partner_search._answer_detection(LOOKS, None), partner_search._answer_detection(replace_in(LOOKS,
            sensor=None), 1)],
     "0.87 0.87"),
    (lambda: [partner_search._possible(x) for x in (-1.0, 0.0, 1e-13, 0.3, 1.0 + 1e-9)], "1e-12 1e-12 1e-12 0.3 1"),
    (lambda: [partner_search._coverage(partner_search._equal_axes(2e-6, 3e-6), 5e-6),
            partner_search._coverage(partner_search._equal_axes(9.0, 0.0), 5e-6)],
     "0.676335066 1e-12"),
    (lambda: [(f := FOUND).early_s, f.simulated_probability, f.simulated_mean_s, f.possible], "2.5 0.666666667 1.75 1"),
    (lambda: [(f := replace(FOUND, outcome=Outcome(TWO.scaled(1e-10), TWO))).early_s, f.possible], "nan 0"),
    (lambda: [replace(FOUND, simulated=SequenceRuns(np.zeros(2, dtype=bool), np.ones(2))).simulated_mean_s], "nan"),
])  # fmt: skip
def test_chances_of_a_partner_at_their_edges_have_these_numbers(found, expected):
    assert list(found()) == pytest.approx([float(each) for each in expected.split()], rel=1e-6, abs=0.0, nan_ok=True)


def test_each_time_of_an_acquisition_has_its_own_place_in_the_sequence():
    times = {"settle_s": 2.5, "detection_s": 0.01, "detection_frames": 7, "response_s": 0.2, "measurement_s": 0.03,
             "steering_s": 0.04, "lock_s": 0.5}  # fmt: skip
    two = SimpleNamespace(called={"leo": "A", "geo": "B"}.get)
    timing = partner_search._timing(two, SimpleNamespace(**times), 4e7)
    assert timing == Timing(
        range_m=4e7, body_settling_s=2.5, frame_time_s=0.01, frames=7, geo_response_s=0.2, leo_detection_s=0.03,
        mirror_settling_s=0.04, lock_time_s=0.5, own_name="A", partner_name="B",
    )  # fmt: skip
    alike = partner_search._timing(SimpleNamespace(called=lambda role: "A"), SimpleNamespace(**times), 4e7)
    assert (alike.own_name, alike.partner_name) == ("A (own)", "A (partner)")


def test_a_way_that_ends_in_lock_as_seldom_as_any_is_told_of_is_possible():
    def possible(probability):
        return replace(FOUND, outcome=SimpleNamespace(success_probability=probability)).possible

    assert possible(partner_search.RAREST)
    assert not possible(math.nextafter(partner_search.RAREST, 0.0))


def test_a_stage_that_never_ends_has_no_longest_time():
    never = merged(np.array([3.0]), np.array([0.0]))
    stage = replace(CHAIN[0], duration_s=never)
    assert (never.time_s.size, stage.longest_s) == (0, 0.0)
    ends = replace(CHAIN[0], duration_s=merged(np.array([0.7, 0.3]), np.array([0.25, 0.5])))
    assert ends.longest_s == 0.7


@pytest.mark.parametrize("threshold", [math.inf, -math.inf, math.nan])
def test_a_threshold_without_an_end_is_refused(threshold):
    with pytest.raises(ValueError, match=f"^the threshold is {threshold:g} times the noise: it must be finite$"):
        frame_detection_probability(1.0, threshold)


@pytest.mark.parametrize("probability", [-0.1, math.nan, math.inf, 0.5 + 1e-9])
def test_a_probability_that_no_time_has_is_refused(probability):
    with pytest.raises(ValueError, match=r"^no time has the probability .*: it must lie above 0 and be at most 0\.5"):
        ONE.quantile(probability)
    assert ONE.quantile(0.5) == 1.0
