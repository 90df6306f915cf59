"""Seeded simulation of a scan over its real path, with vibration, and of the sequence, event by event."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from microrad.link.acquisition.checks import require_count, require_not_negative, require_positive
from microrad.link.acquisition.scan import Scan
from microrad.link.acquisition.sequence import LOCKED, LOST, Stage, check_sequence
from microrad.link.acquisition.times import TimeDistribution

_Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Vibration:
    """Ornstein-Uhlenbeck jitter of the beam: rms in each axis and correlation time (spectrum 1/(2 pi time) wide)."""

    rms_rad: float
    correlation_time_s: float

    def __post_init__(self) -> None:
        """Refuse a negative rms and a correlation time that is not positive."""
        require_not_negative("the vibration's rms", self.rms_rad, "rad")
        require_positive("the vibration's correlation time", self.correlation_time_s, "s")


@dataclass(frozen=True, slots=True, eq=False)
class ScanRuns:
    """One simulated scan per run: where the target was, whether it was detected, and the time then or of the end."""

    target_x_rad: _Array
    target_y_rad: _Array
    detected: NDArray[np.bool_]
    time_s: _Array


def simulate_scan(scan: Scan, runs: int, seed: int, vibration: Vibration | None = None, samples: int = 128) -> ScanRuns:
    """Draw targets from the uncertainty and let the beam pass over each; (runs,) arrays.

    The beam follows its real path, `samples` points of it near the target in each pass, shifted by one continuous
    vibration of the whole scan. Every whole detection time that the beam stays on the target is one look.
    Raises `ValueError` for no run and for less than 2 samples.
    """
    require_count("the number of runs", runs)
    if samples < 2:
        raise ValueError(f"the number of samples in a pass is {samples}: it must be 2 or more")
    draw = np.random.Generator(np.random.Philox(key=seed))
    x, y = (draw.normal(0.0, scan.search.sigma_rad, runs) for _ in range(2))
    shake = vibration or Vibration(0.0, 1.0)
    start, end = scan.windows(x, y, scan.search.beam_radius_rad + 6.0 * shake.rms_rad)
    state = _Pass(scan, x, y, shake, draw)
    for window in range(start.shape[1]):
        begin, span = start[:, window], end[:, window] - start[:, window]
        for sample in range(samples):
            state.move(begin + span * (sample / (samples - 1)), begin + span / 2.0)
    return ScanRuns(x, y, state.detected, np.where(state.detected, state.found_s, scan.duration_s))


class _Pass:
    """The beam relative to the target in every run: time, vibration and how long the target has been lit."""

    def __init__(self, scan: Scan, x_rad: _Array, y_rad: _Array, shake: Vibration, draw: np.random.Generator) -> None:
        self.scan, self.shake, self.draw = scan, shake, draw
        self.target = np.stack([x_rad, y_rad])
        self.jitter = draw.normal(0.0, shake.rms_rad, self.target.shape) if shake.rms_rad else np.zeros((2, x_rad.size))
        self.time_s = np.zeros(x_rad.size)
        self.within_s = np.full(x_rad.size, -1.0)
        self.margin = np.ones(x_rad.size)  # squared distance less squared beam radius: negative when lit
        self.lit_s = np.zeros(x_rad.size)
        self.detected = np.zeros(x_rad.size, dtype=bool)
        self.found_s = np.zeros(x_rad.size)

    def move(self, time_s: _Array, within_s: _Array) -> None:
        """Go on to `time_s`; a gap in the path, or a new pass, ends what was lit."""
        step = np.maximum(time_s - self.time_s, 0.0)
        if self.shake.rms_rad:
            kept = np.exp(-step / self.shake.correlation_time_s)
            noise = self.draw.normal(0.0, self.shake.rms_rad, self.jitter.shape)
            self.jitter = kept * self.jitter + np.sqrt(1.0 - kept**2) * noise
        beam = np.stack(self.scan.beam_at(time_s, within_s))
        margin = np.sum((beam + self.jitter - self.target) ** 2, axis=0) - self.scan.search.beam_radius_rad**2
        gap = (within_s != self.within_s) & (step > 0.0)
        before = np.where(gap, margin, self.margin)
        length = np.where(gap, 0.0, step)
        change = np.where(before == margin, 1.0, before - margin)
        part = np.clip(before / change, 0.0, 1.0)  # share of the step before the edge of the beam passes
        lit = margin < 0.0
        was = before < 0.0
        added = length * np.where(was, np.where(lit, 1.0, part), np.where(lit, 1.0 - part, 0.0))
        self.lit_s = np.where(was & ~gap, self.lit_s, 0.0) + added
        self._look(time_s)
        self.time_s, self.within_s, self.margin = np.maximum(time_s, self.time_s), within_s, margin

    def _look(self, time_s: _Array) -> None:
        needed = self.scan.detector.detection_time_s
        while True:
            ready = self.lit_s >= needed * (1.0 - 1e-6)
            if not np.any(ready):
                return
            self.lit_s = np.where(ready, self.lit_s - needed, self.lit_s)
            seen = ready & ~self.detected & (self.draw.random(ready.size) < self.scan.detector.probability)
            self.found_s[seen] = time_s[seen]
            self.detected |= seen


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
    time_s: _Array


def simulate(stages: Sequence[Stage], attempts: int, runs: int, seed: int) -> SequenceRuns:
    """Draw the sequence event by event; `attempts` as in `solve`. Raises `ValueError` as it does, and for no run."""
    require_count("the number of runs", runs)
    back = check_sequence(stages, attempts)
    draw = np.random.Generator(np.random.Philox(key=seed))
    logs = [_run(stages, back, attempts, draw) for _ in range(runs)]
    return SequenceRuns(np.array([log[-1].to == LOCKED for log in logs]), np.array([log[-1].time_s for log in logs]))


def simulate_log(stages: Sequence[Stage], attempts: int, seed: int) -> tuple[Transition, ...]:
    """Log of one run: that of the first run of `simulate` with the same seed."""
    back = check_sequence(stages, attempts)
    return tuple(_run(stages, back, attempts, np.random.Generator(np.random.Philox(key=seed))))


_DONE = "done"


def _run(stages: Sequence[Stage], back: Sequence[int], attempts: int, draw: np.random.Generator) -> list[Transition]:
    time_s, index, failures = 0.0, 0, 0
    log: list[Transition] = []
    while index < len(stages) and failures < attempts:
        stage = stages[index]
        if draw.random() < stage.success_probability:
            time_s += _duration(stage, draw)
            following, cause = index + 1, _DONE
        else:
            time_s += stage.failure_s
            failures += 1
            following, cause = back[index], f"time-out, failure {failures} of {attempts}"
        name = stages[following].name if following < len(stages) else LOCKED
        log.append(Transition(time_s, stage.name, LOST if failures == attempts else name, cause))
        index = following
    return log


def _duration(stage: Stage, draw: np.random.Generator) -> float:
    if not isinstance(stage.duration_s, TimeDistribution):
        return stage.duration_s
    cumulative = np.cumsum(stage.duration_s.weight)
    index = int(np.searchsorted(cumulative, draw.random() * cumulative[-1], side="right"))
    return float(stage.duration_s.time_s[min(index, cumulative.size - 1)])
