"""The error of simulated runs in time windows, with hysteresis, limits and quantisation, and its intervals.

A run hands out its error at the control samples slice by slice, and what is counted of it keeps sums alone. Windows
stand behind each other from the end of the settling on, and so do the first windows of the pairs of a difference.
"""

import math
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import islice
from typing import Any, Generic, Protocol, TypeVar

import numpy as np

from microrad.core import kernels
from microrad.core.arrays import Floats
from microrad.core.intervals import student
from microrad.core.progress import Progress
from microrad.core.threads import in_threads
from microrad.core.units import format_quantity
from microrad.loop.disturbance.windows import ErrorIndex
from microrad.loop.pointing_loop.ensemble import SLICE_SAMPLES, Span, control_samples
from microrad.loop.pointing_loop.kernel_arrays import LANES, arrays, reference, start
from microrad.loop.pointing_loop.linear import ClosedLoop, close, refuse_unstable
from microrad.loop.pointing_loop.loop import LoopController, PointingLoop
from microrad.loop.pointing_loop.windows import readings_of, windowed_in_all

CONFIDENCE = 0.99
"""That of the intervals."""
_Answer = TypeVar("_Answer")


class Tally(Protocol):
    """What is counted of the runs of a batch."""

    def add(self, at: int, error: Floats) -> None:
        """Some control samples, the first of them so many behind the settling: error (rad), (samples, axes, LANES)."""

    @property
    def mean(self) -> Floats:
        """Mean over what was counted, run by run, shape (numbers, LANES)."""


@dataclass(frozen=True, slots=True)
class Question(Generic[_Answer]):
    """What is asked of runs: what counts of them, and what follows from it.

    ``tallies`` makes what counts, for a batch of runs. ``answer`` takes the means of each, shape (runs, numbers). With
    ``twin`` each run is shown beside another one, the error of a second terminal like the first: its axes behind ours.
    """

    tallies: Callable[[], Sequence[Tally]]
    answer: Callable[[Sequence[Floats]], _Answer]
    twin: bool = False


def ask(
    questions: Sequence[Question[Any]],
    loop: PointingLoop,
    controller: LoopController,
    span: Span,
    runs: int,
    *,
    threads: int | None = None,
    on_progress: Progress = lambda done, total, what: None,
) -> list[Any]:
    """The answers to questions about the same runs, which are simulated once.

    They are the runs of `ensemble.simulate`, on any number of threads.

    Args:
        questions: What is asked.
        loop: The loop.
        controller: The controller of all its axes.
        span: How long a run is, what is left out at its begin, and the seed.
        runs: How many runs there are, 1 or more.
        threads: Threads to share them, by default one for each core.
        on_progress: Called with the runs that are done, their number and what is done.

    Raises:
        ValueError: For a controller that does not fit the loop, less than one run, and a run that ends before it has
            settled.
    """
    if runs < 1:
        raise ValueError(f"{runs} runs leave no errors: ask for 1 run or more, 2 for an interval")

    beyond = -(-runs // LANES) * LANES  # the first run of a second terminal: none of the first one's

    def batch(first: int) -> list[Floats]:
        counting = [(tally, question.twin) for question in questions for tally in question.tallies()]
        terminals = [first, first + beyond] if any(twin for _, twin in counting) else [first]
        for slices in zip(*(_residual(loop, controller, span, each) for each in terminals), strict=True):
            at, errors = slices[0][0], [error for _, error in slices]
            for tally, twin in counting:
                tally.add(at, np.concatenate(errors, axis=1) if twin else errors[0])
        return [tally.mean for tally, _ in counting]

    jobs = [partial(batch, first) for first in range(0, runs, LANES)]

    def tell(done: int, _: int) -> None:
        on_progress(min(done * LANES, runs), runs, "simulating windows")

    parts = zip(*in_threads(jobs, tell, threads), strict=True)
    means = iter([np.concatenate(each, axis=1).T[:runs] for each in parts])
    return [question.answer([*islice(means, len(question.tallies()))]) for question in questions]


def _residual(
    loop: PointingLoop, controller: LoopController, span: Span, first_run: int
) -> Iterator[tuple[int, Floats]]:
    """The error of LANES runs behind the settling, slice by slice."""
    p, nothing = arrays(loop, controller, span.seed), np.empty((0, 0, 0))
    state, (total, settle) = start(loop, p, first_run), control_samples(loop, span)
    for first, last in ((0, settle), (settle, total)):
        for at in range(first, last, SLICE_SAMPLES):
            end = min(at + SLICE_SAMPLES, last)
            error = np.empty((end - at, loop.axes, LANES)) if at >= settle else nothing
            kernels.ensemble_loop(p, state, reference(loop, at, end), error, nothing, kernels.UNSHIFTED)
            if at >= settle:
                yield at - settle, error


class Windows:
    """Sums over windows that stand behind each other, of values that come in slices.

    Args:
        length: Samples in a window.
        begin: The sample with which the first of them begins.
    """

    def __init__(self, length: int, begin: int = 0) -> None:
        """Nothing is summed yet."""
        self.length, self._begin, self._open = length, begin, 0.0

    def add(self, at: int, values: Floats) -> Floats:
        """The sums of the windows that end in a slice, shape (windows, ...).

        Args:
            at: Number of its first sample.
            values: The slice, shape (samples, ...), right behind the last one.
        """
        values, at = values[max(self._begin - at, 0) :], max(at, self._begin) - self._begin
        ends = np.arange(self.length - at % self.length, len(values) + 1, self.length)
        if not len(values):
            return values
        sums = np.add.reduceat(values, [0, *ends[ends < len(values)]], axis=0)
        sums[0] += self._open
        self._open = sums[-1] if len(sums) > len(ends) else 0.0
        return sums[: len(ends)]


class _Squares:
    """Mean square of what an index takes, run by run and axis by axis."""

    def __init__(self, index: ErrorIndex, window: int, apart: int) -> None:
        self._takes, self._total, self._number = index.takes, 0.0, 0
        self._first, self._second = Windows(window), Windows(window, apart) if apart else None
        self._waiting = deque[Floats]()  # means of first windows whose second ones have not ended

    def add(self, at: int, error: Floats) -> None:
        """Some control samples: see `Tally`."""
        squares = self._squares(at, error)
        self._total = self._total + np.sum(squares, axis=0)
        self._number += len(squares)

    def _squares(self, at: int, error: Floats) -> Floats:
        if self._takes == "APE":
            return error**2
        if self._takes == "RPE":
            both = np.concatenate([error, error**2], axis=1)
            mean, square = np.split(self._first.add(at, both) / self._first.length, 2, axis=1)
            return np.asarray(square - mean**2)
        means = self._first.add(at, error) / self._first.length
        if self._second is None:
            return np.asarray(means**2)
        self._waiting.extend(means)
        later = self._second.add(at, error) / self._first.length
        return np.asarray([(mean - self._waiting.popleft()) ** 2 for mean in later]).reshape(later.shape)

    @property
    def mean(self) -> Floats:
        """Mean square (rad^2), shape (axes, LANES)."""
        return np.asarray(self._total / self._number)


@dataclass(frozen=True, slots=True)
class SimulatedErrors:
    """What an index takes of the error of simulated runs, about zero.

    ``axis_rms_rad`` (axes,) and ``rms_rad``, radial, are of all windows of all runs. ``interval_rad`` is the half width
    of the 99 % interval of the radial one, from the spread between the runs; infinite for one run. ``linear_rad`` is
    the same of the linear loop, radial and exact, seen at the control samples, too.
    """

    index: ErrorIndex
    axis_rms_rad: Floats
    rms_rad: float
    interval_rad: float
    linear_rad: float


def half_width(by_run: Floats) -> float:
    """Half width of the 99 % interval of a mean over runs, by Student's t; infinite for one run.

    Args:
        by_run: What is averaged, shape (runs,).
    """
    if by_run.size < 2:
        return math.inf
    return student(CONFIDENCE, by_run.size - 1) * float(np.std(by_run, ddof=1)) / math.sqrt(by_run.size)


def _times(loop: PointingLoop, index: ErrorIndex, span: Span) -> tuple[int, int]:
    """Window and spacing of an index in control samples, 0 for a time that it has not; refused where no run has it."""
    window, apart = (readings * loop.optical.every for readings in readings_of(loop, index))
    total, settle = control_samples(loop, span)
    period = loop.timing.period_s
    if window == 1:
        raise ValueError(
            f"{index.kind} over {format_quantity(period, 's')} looks at one control sample of a run: give a window of "
            "two or more"
        )
    if window + apart > total - settle:
        needed, left = (format_quantity(count * period, "s") for count in (window + apart, total - settle))
        raise ValueError(
            f"{index.kind} looks at {needed} of a run, and {left} are left behind its settling: give shorter times or "
            "longer runs"
        )
    return window, apart


def windows_asked(
    loop: PointingLoop,
    controller: LoopController,
    indices: Sequence[ErrorIndex],
    span: Span,
    theory: PointingLoop | None = None,
) -> Question[tuple[SimulatedErrors, ...]]:
    """The question what each index takes of the error of runs at their control samples, one result for each index.

    Args:
        loop: The loop.
        controller: The controller of all its axes.
        indices: What counts of the error; their times are rounded to whole readings of the optical sensor.
        span: How long a run is, what is left out at its begin, and the seed.
        theory: The loop that the linear figures are of; by default the same, at the slow gains of its hysteresis.

    Raises:
        ValueError: For a window that is shorter than two control samples or does not fit into a run behind its
            settling, and for a loop that is unstable in theory.
    """
    closed = close(theory or loop, controller)
    refuse_unstable(closed)
    times = [_times(loop, index, span) for index in indices]

    def tallies() -> list[_Squares]:
        return [_Squares(index, *each) for index, each in zip(indices, times, strict=True)]

    def answer(found: Sequence[Floats]) -> tuple[SimulatedErrors, ...]:
        return tuple(_errors(index, squares, closed) for index, squares in zip(indices, found, strict=True))

    return Question(tallies, answer)


def simulated_windows(
    loop: PointingLoop,
    controller: LoopController,
    indices: Sequence[ErrorIndex],
    span: Span,
    runs: int,
    *,
    threads: int | None = None,
    on_progress: Progress = lambda done, total, what: None,
) -> tuple[SimulatedErrors, ...]:
    """That question alone.

    Args:
        loop: The loop.
        controller: The controller of all its axes.
        indices: What counts of the error.
        span: How long a run is, what is left out at its begin, and the seed.
        runs: How many runs there are, 1 or more.
        threads: Threads to share them, by default one for each core.
        on_progress: Called with the runs that are done, their number and what is done.

    Raises:
        ValueError: As `windows_asked` and `ask`.
    """
    asked = windows_asked(loop, controller, indices, span)
    (found,) = ask([asked], loop, controller, span, runs, threads=threads, on_progress=on_progress)
    answer: tuple[SimulatedErrors, ...] = found
    return answer


def _errors(index: ErrorIndex, squares: Floats, closed: ClosedLoop) -> SimulatedErrors:
    """From the mean squares of each run (rad^2), shape (runs, axes)."""
    radial = np.sum(squares, axis=1)
    rms = math.sqrt(float(np.mean(radial)))
    linear = math.sqrt(max(float(np.sum(windowed_in_all(closed, index, at_samples=True))), 0.0))
    half = half_width(radial) / (2.0 * rms) if rms else 0.0
    return SimulatedErrors(index, np.sqrt(np.mean(squares, axis=0)), rms, half, linear)
