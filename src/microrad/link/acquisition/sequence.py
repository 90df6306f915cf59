"""Acquisition as a chain of timed stages with retries: probability and time until both terminals lock."""

import math
from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from microrad.core.arrays import Floats
from microrad.core.units import SPEED_OF_LIGHT_M_S, format_input, format_limit
from microrad.link.acquisition.scan import Duration, DurationOrZero, Probability
from microrad.link.acquisition.times import TimeDistribution, fixed_time, joined
from microrad.mission.fields import Bounded, Quantity, Whole

LOCKED = "locked"
LOST = "lost"
_CHANCE, _TIME, _COUNT = Quantity("", above=0.0, most=1.0), Quantity("s", least=0.0), Whole("", least=1)


@dataclass(frozen=True, slots=True)
class Stage:
    """One stage: it lasts `duration_s` and succeeds, or fails and has then cost `timeout_s`.

    A `duration_s` that is a distribution is that of success, whatever its sum. Left out, the time-out is the duration,
    the longest one. After a failure the chain goes back to the stage named `on_failure`, or repeats this one.
    """

    name: str
    duration_s: float | TimeDistribution
    success_probability: float = 1.0
    timeout_s: float | None = None
    on_failure: str = ""

    def __post_init__(self) -> None:
        """Raises ValueError if the probability is not in (0, 1], a time negative, or the time-out too short."""
        _CHANCE.check(f'the probability of success of the stage "{self.name}"', self.success_probability)
        _TIME.check(f'the duration of the stage "{self.name}"', self.longest_s)
        _TIME.check(f'the time-out of the stage "{self.name}"', self.failure_s)
        if self.failure_s < self.longest_s:
            raise ValueError(
                f'the stage "{self.name}" lasts {format_limit(self.longest_s, "s", least=True)} and its time-out is'
                f" {format_input(self.failure_s, 's')}: the time-out must not be shorter"
            )

    @property
    def longest_s(self) -> float:
        """Longest duration of success."""
        if isinstance(self.duration_s, TimeDistribution):
            return float(self.duration_s.time_s[-1]) if self.duration_s.time_s.size else 0.0
        return self.duration_s

    @property
    def failure_s(self) -> float:
        """Time that a failure costs."""
        return self.longest_s if self.timeout_s is None else self.timeout_s

    @property
    def success_times(self) -> TimeDistribution:
        """Duration of success, with probabilities that sum to that of success."""
        if isinstance(self.duration_s, TimeDistribution):
            return self.duration_s.given_success().scaled(self.success_probability)
        return fixed_time(self.duration_s, self.success_probability)


@dataclass(frozen=True, slots=True, eq=False)
class Outcome:
    """What a sequence comes to: the time until lock and the time until it is given up; their probabilities sum to 1."""

    locked: TimeDistribution
    lost: TimeDistribution

    @property
    def success_probability(self) -> float:
        """Probability of lock."""
        return self.locked.probability

    @property
    def mean_time_s(self) -> float:
        """Mean time until lock, given lock."""
        return self.locked.mean_s


@dataclass(frozen=True, slots=True)
class Timing(Bounded):
    """Times of the paper's sequence; the range gives the light time.

    GEO looks for the beacon in `frames` frames of `frame_time_s`. `geo_response_s` is the time GEO needs to turn and
    answer, `leo_detection_s` that of LEO's measurement of the answer, `lock_time_s` that of each terminal to lock.
    `own_name` and `partner_name` are what the stages call LEO and GEO.
    """

    range_m: Annotated[float, Quantity("m", above=0.0)]
    body_settling_s: DurationOrZero
    frame_time_s: Duration
    frames: Annotated[int, _COUNT]
    geo_response_s: DurationOrZero
    leo_detection_s: DurationOrZero
    mirror_settling_s: DurationOrZero
    lock_time_s: DurationOrZero
    own_name: str = "LEO"
    partner_name: str = "GEO"

    @property
    def light_time_s(self) -> float:
        """Time of the light from one terminal to the other."""
        return self.range_m / SPEED_OF_LIGHT_M_S


@dataclass(frozen=True, slots=True)
class Chances(Bounded):
    """Probabilities of the paper's sequence, each in (0, 1].

    Coverage is the probability that a beam lands: `beacon_coverage` that of LEO's body pointing within the beacon,
    `answer_coverage` that of GEO's pointing within its narrow beam, `return_coverage` that of LEO's narrow beam under
    its sensor noise and point-ahead error. `frame_detection` is the detection in one frame of a beacon that lands,
    `answer_detection` that of LEO's sensor, `lock` that of each terminal on a beam that lands.
    """

    beacon_coverage: Probability
    frame_detection: Probability
    answer_coverage: Probability
    answer_detection: Probability
    return_coverage: Probability
    lock: Probability = 1.0


def frame_detection_probability(signal_to_noise: float, threshold_to_noise: float) -> float:
    """Probability that a frame's signal with unit Gaussian noise exceeds the threshold.

    With a signal of zero this is the probability of a false alarm in a frame.

    Args:
        signal_to_noise: Signal over the rms of the noise, at least 0.
        threshold_to_noise: Threshold over the rms of the noise, of any sign.

    Raises:
        ValueError: If the signal is negative, or either is not finite.
    """
    Quantity("", least=0.0).check("the signal-to-noise ratio", signal_to_noise)
    if not math.isfinite(threshold_to_noise):
        raise ValueError(f"the threshold is {threshold_to_noise:g} times the noise: it must be finite")
    return 0.5 * math.erfc((threshold_to_noise - signal_to_noise) / math.sqrt(2.0))


def frames_detection_probability(frame_probability: float, frames: int) -> float:
    """Probability of detection in at least one of independent frames, 1 - (1 - p)^n.

    Args:
        frame_probability: Probability p of detection in one frame, above 0 and at most 1.
        frames: Number n of frames, at least 1.

    Raises:
        ValueError: If either is outside its limits.
    """
    _CHANCE.check("the probability of detection in a frame", frame_probability)
    _COUNT.check("the number of frames", frames)
    return 1.0 - (1.0 - frame_probability) ** frames


def beacon_stages(timing: Timing, chances: Chances) -> tuple[Stage, ...]:
    """First stages with the wide beacon: LEO's body settles, light time, GEO detects.

    Where the beacon does not land, no frame helps: coverage times the probability of the frames. A failure costs LEO
    the wait for an answer, and its body points anew.

    Args:
        timing: Durations of the steps, and the names of the two terminals.
        chances: Probability that each step succeeds.
    """
    detect_s = timing.frames * timing.frame_time_s
    detected = chances.beacon_coverage * frames_detection_probability(chances.frame_detection, timing.frames)
    wait_s = detect_s + timing.geo_response_s + timing.light_time_s + timing.leo_detection_s
    first = f"{timing.own_name} points the beacon"
    return (
        Stage(first, timing.body_settling_s),
        Stage("beacon travels", timing.light_time_s),
        Stage(f"{timing.partner_name} detects", detect_s, detected, wait_s, first),
    )


def scan_stages(timing: Timing, scan: TimeDistribution, duration_s: float) -> tuple[Stage, ...]:
    """First stages with a scan by a narrow beam: LEO's body settles, light time, GEO detects.

    A scan without detection is repeated after the wait for an answer, and LEO's body points anew.

    Args:
        timing: Durations of the steps, and the names of the two terminals.
        scan: Time to detection in one scan, with its probability.
        duration_s: Duration of one whole scan, in s.
    """
    wait_s = duration_s + timing.geo_response_s + timing.light_time_s + timing.leo_detection_s
    probability = min(scan.probability, 1.0)
    first = f"{timing.own_name} points the scan"
    return (
        Stage(first, timing.body_settling_s),
        Stage("beam travels", timing.light_time_s),
        Stage(f"{timing.partner_name} detects", scan.given_success(), probability, wait_s, first),
    )


def answer_stages(timing: Timing, chances: Chances) -> tuple[Stage, ...]:
    """Stages from GEO's answer to lock.

    When the answer does not land, GEO answers again; when LEO's narrow beam does not, or a lock fails, LEO measures
    the answer again. LEO learns that GEO has not locked only after the light time back.

    Args:
        timing: Durations of the steps, and the names of the two terminals.
        chances: Probability that each step succeeds.
    """
    light_s, lock_s = timing.light_time_s, timing.lock_time_s
    answered = chances.answer_coverage * chances.answer_detection
    own, partner = timing.own_name, timing.partner_name
    answer, again = f"{partner} turns and answers", f"{own} detects the answer"
    return (
        Stage(answer, timing.geo_response_s),
        Stage("answer travels", light_s),
        Stage(again, timing.leo_detection_s, answered, timing.leo_detection_s + light_s, answer),
        Stage(f"{own}'s mirror turns", timing.mirror_settling_s),
        Stage("narrow beam travels", light_s),
        Stage(f"{partner} locks", lock_s, chances.return_coverage * chances.lock, lock_s + light_s, again),
        Stage(f"{partner}'s beam travels", light_s),
        Stage(f"{own} locks", lock_s, chances.lock, lock_s, again),
    )


def paper_sequence(timing: Timing, chances: Chances) -> tuple[Stage, ...]:
    """The sequence of the paper's section 2.1: wide beacon, narrow answer, narrow beam back, both lock.

    The paper gives the order alone; what follows a failure is the choice of `beacon_stages` and `answer_stages`.

    Args:
        timing: Durations of the steps, and the names of the two terminals.
        chances: Probability that each step succeeds.
    """
    return (*beacon_stages(timing, chances), *answer_stages(timing, chances))


def solve_sequence(stages: Sequence[Stage], attempts: int) -> Outcome:
    """Distribution of the time until lock when every failure takes one attempt; the last one gives up.

    Exact: all orders of failures are summed; times that are distributions are convolved.

    Args:
        stages: In order, each of another name.
        attempts: Failures until the sequence is given up, at least 1.

    Raises:
        ValueError: If there is no attempt or no stage, if two stages have one name, or a failure goes back to a stage
            that is not there or comes later.
    """
    back = check_sequence(stages, attempts)
    locked: list[TimeDistribution] = []
    lost: list[TimeDistribution] = []
    arrivals: list[list[TimeDistribution]] = [[] for _ in stages]
    arrivals[0].append(fixed_time(0.0))
    for attempt in range(attempts):
        failed: list[list[TimeDistribution]] = [[] for _ in stages]
        for index, stage in enumerate(stages):
            if not arrivals[index]:
                continue
            here = joined(arrivals[index])
            after = arrivals[index + 1] if index + 1 < len(stages) else locked
            after.append(here.followed_by(stage.success_times))
            if stage.success_probability < 1.0:
                fail = here.shifted(stage.failure_s).scaled(1.0 - stage.success_probability)
                (lost if attempt == attempts - 1 else failed[back[index]]).append(fail)
        arrivals = failed
    none = fixed_time(0.0, 0.0)
    return Outcome(joined([*locked, none]), joined([*lost, none]))


def check_sequence(stages: Sequence[Stage], attempts: int) -> tuple[int, ...]:
    """Index of the stage to which each stage goes back on failure.

    Args:
        stages: The stages in their order.
        attempts: Failures until the sequence is given up, at least 1.

    Raises:
        ValueError: For no stage, two of one name, a stage that goes back to a later or unknown one, and no attempt.
    """
    _COUNT.check("the number of attempts", attempts)
    names = [stage.name for stage in stages]
    if not names:
        raise ValueError("the sequence has no stage: give at least one")
    if len(set(names)) < len(names):
        raise ValueError(f"two stages have the same name among {', '.join(names)}: name each differently")
    for index, stage in enumerate(stages):
        if stage.on_failure and stage.on_failure not in names[: index + 1]:
            raise ValueError(
                f'"{stage.name}" goes back to "{stage.on_failure}" on failure: it must be itself or an earlier stage,'
                f" one of {', '.join(names[: index + 1])}"
            )
    return tuple(names.index(s.on_failure) if s.on_failure else i for i, s in enumerate(stages))


# ------------------------------------------------------------------------------------------------------------ simulated
@dataclass(frozen=True, slots=True)
class Transition:
    """One entry of a log: at `time_s` the chain leaves `stage` for `to`, and why."""

    time_s: float
    stage: str
    to: str
    cause: str


@dataclass(frozen=True, slots=True, eq=False)
class SequenceRuns:
    """Simulated sequences: whether each locked, and when it locked or was given up; (runs,) arrays."""

    locked: NDArray[np.bool_]
    time_s: Floats


def simulate(stages: Sequence[Stage], attempts: int, runs: int, seed: int) -> SequenceRuns:
    """Draw the sequence event by event, many times over.

    Args:
        stages: The stages in their order.
        attempts: Failures until the sequence is given up, at least 1.
        runs: Number of sequences drawn, at least 1.
        seed: Seed of the random numbers; the same one gives the same runs.

    Raises:
        ValueError: As `solve_sequence`, and for no run.
    """
    _COUNT.check("the number of runs", runs)
    back = check_sequence(stages, attempts)
    draw = np.random.Generator(np.random.Philox(key=seed))
    ends = [_moments(stage) for stage in stages]
    found = [_run(stages, back, attempts, draw, ends) for _ in range(runs)]
    return SequenceRuns(np.array([locked for locked, _ in found]), np.array([time_s for _, time_s in found]))


def simulate_log(stages: Sequence[Stage], attempts: int, seed: int) -> tuple[Transition, ...]:
    """Log of one run: that of the first run of `simulate` with the same seed.

    Args:
        stages: The stages in their order.
        attempts: Failures until the sequence is given up, at least 1.
        seed: Seed of the random numbers.

    Raises:
        ValueError: As `solve_sequence`.
    """
    back = check_sequence(stages, attempts)
    log: list[Transition] = []
    draw = np.random.Generator(np.random.Philox(key=seed))
    _run(stages, back, attempts, draw, [_moments(stage) for stage in stages], log)
    return tuple(log)


_DONE = "done"

_Moments = tuple[list[float], list[float]]


def _moments(stage: Stage) -> _Moments:
    """Weights up to each moment at which a stage may end, and the moments in s; no weight where there is one alone."""
    if not isinstance(stage.duration_s, TimeDistribution):
        return [], [stage.duration_s]
    return np.cumsum(stage.duration_s.weight).tolist(), stage.duration_s.time_s.tolist()


def _run(
    stages: Sequence[Stage],
    back: Sequence[int],
    attempts: int,
    draw: np.random.Generator,
    moments: Sequence[_Moments],
    log: list[Transition] | None = None,
) -> tuple[bool, float]:
    """Whether one run locks, and when it does or is given up, in s; its transitions are added to the log."""
    time_s, index, failures = 0.0, 0, 0
    while index < len(stages) and failures < attempts:
        stage = stages[index]
        if draw.random() < stage.success_probability:
            up_to, ends = moments[index]
            time_s += ends[min(bisect_right(up_to, draw.random() * up_to[-1]), len(ends) - 1)] if up_to else ends[0]
            following, cause = index + 1, _DONE
        else:
            time_s += stage.failure_s
            failures += 1
            following, cause = back[index], f"time-out, failure {failures} of {attempts}"
        if log is not None:
            name = stages[following].name if following < len(stages) else LOCKED
            log.append(Transition(time_s, stage.name, LOST if failures == attempts else name, cause))
        index = following
    return failures < attempts, time_s
