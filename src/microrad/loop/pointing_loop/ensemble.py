"""Many runs of a fine-pointing loop and their statistics."""

import math
import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from microrad.core import compiling, kernels, lti
from microrad.core.arrays import Floats
from microrad.core.labelled import TEXT, Dataset, Group, Variable, variables
from microrad.core.progress import Progress
from microrad.core.threads import in_background, in_threads
from microrad.loop.pointing_loop.kernel_arrays import LANES, Shaping, arrays, combined_shaping, reference, start
from microrad.loop.pointing_loop.loop import LoopController, PointingLoop

SLICE_SAMPLES = 2048  # control samples between two returns from the kernel, and at most in a segment of the spectrum


COUNTERS = {
    "saturated samples": kernels.COUNT_SATURATED,
    "slew-limited steps": kernels.COUNT_SLEW,
    "steps beyond the identified rate": kernels.COUNT_CLAMPED,
    "inverse beyond the identified rate": kernels.COUNT_INVERSE_CLAMPED,
    "steps outside the identified drive range": kernels.COUNT_OUTSIDE,
    "samples without the spot": kernels.COUNT_LOST,
}
"""Limits that a run may meet, and where `Ensemble.counts` counts them."""


@dataclass(frozen=True, slots=True)
class Ensemble:
    """Statistics of many runs of one loop under one controller, taken behind the settling time.

    By run: ``rms_rad`` (runs, axes) about zero, ``mean_rad`` (runs, axes), ``largest_rad`` radial (runs,), and
    ``counts`` (runs, kernels.COUNT_*). ``histogram`` (runs, bins) counts the radial error at the control samples. The
    one-sided spectrum of the residual, ``psd_rad2_hz`` (frequencies, axes), is of the first batch of runs.
    """

    name: str
    seconds: float
    rms_rad: Floats
    mean_rad: Floats
    largest_rad: Floats
    histogram: NDArray[np.int32]
    counts: Floats
    freq_hz: Floats
    psd_rad2_hz: Floats
    samples: int
    steps: int
    readings: int

    @property
    def axis_rms_rad(self) -> Floats:
        """Root mean square by axis over all runs."""
        return np.asarray(np.sqrt(np.mean(self.rms_rad**2, axis=0)))

    @property
    def radial_rms_rad(self) -> float:
        """Root mean square of the radial error over all runs."""
        return float(np.sqrt(np.mean(np.sum(self.rms_rad**2, axis=1))))

    def radial_rms_interval_rad(self, sigmas: float = 2.576) -> float:
        """Half width of the radial rms's interval of confidence, from its spread between runs; infinite for one run.

        It is ``sigmas`` standard errors, 99 % by default.
        """
        squares = np.sum(self.rms_rad**2, axis=1)
        if squares.size < 2:
            return math.inf
        spread = float(np.std(squares, ddof=1)) / math.sqrt(squares.size)
        return sigmas * spread / (2.0 * self.radial_rms_rad)

    def quantile_rad(self, share: float) -> float:
        """Radial error that is not exceeded for a share of the time (0 to 1), over all runs, from the histogram."""
        return histogram_quantile(self.histogram.sum(axis=0), share)

    def beyond(self, radius_rad: float) -> float:
        """Share of the time with a larger radial error, over all runs, from the histogram."""
        return histogram_beyond(self.histogram.sum(axis=0), radius_rad)

    def to_xarray(self) -> Dataset:
        """The same by run, axis, radius, limit and frequency; a radius is the upper edge of its bin."""
        by_axis = variables(
            "run axis",
            rms=("rad", "root mean square of the pointing error, about zero", self.rms_rad),
            mean=("rad", "mean of the pointing error", self.mean_rad),
        )
        largest = variables("run", largest=("rad", "largest radial error", self.largest_rad))
        binned = variables("run radius", histogram=("1", "control samples by their radial error", self.histogram))
        met = "how often a limit was met, of all actuators or elements"
        counts = variables("run limit", counts=("1", met, self.counts[:, list(COUNTERS.values())]))
        spectrum = ("rad^2/Hz", "one-sided spectrum of the residual, first batch of runs", self.psd_rad2_hz)
        names = axis_names(self.rms_rad.shape[1])
        names |= variables("radius", radius=("rad", "radial error, upper edge of its bin", bin_edges_rad()[1:]))
        names |= variables("limit", limit=(TEXT, "limit", [*COUNTERS]))
        names |= variables("frequency", frequency=("Hz", "frequency", self.freq_hz))
        data = {**by_axis, **largest, **binned, **counts, **variables("frequency axis", spectrum=spectrum)}
        said = {"controller": self.name, "run_s": self.seconds, "samples": self.samples, "steps": self.steps}
        return Group(data, names, {**said, "readings": self.readings}).to_xarray()

    def part(self, first: int, runs: int) -> "Ensemble":
        """The statistics of some of the runs; the spectrum is left as it is.

        Args:
            first: Place of the first of them among this ensemble's runs, from 0.
            runs: How many there are.
        """
        of = slice(first, first + runs)
        by_run = {
            name: getattr(self, name)[of] for name in ("rms_rad", "mean_rad", "largest_rad", "histogram", "counts")
        }
        return replace(self, **by_run)

    def share(self, counter: int) -> float:
        """How often a counter (`kernels.COUNT_*`) counted, over how often it could have.

        All actuators or elements count together, so that it may exceed 1. Lost spots are per optical reading,
        saturation and the inverse's rate per control sample, the others per plant step.
        """
        sampled = counter in (kernels.COUNT_SATURATED, kernels.COUNT_INVERSE_CLAMPED)
        times = self.readings if counter == kernels.COUNT_LOST else self.samples if sampled else self.steps
        return float(np.mean(self.counts[:, counter])) / max(times, 1)  # no reading in a short run: none lost


def axis_names(axes: int) -> dict[str, Variable]:
    """Axes of the line of sight, as a coordinate."""
    return variables("axis", axis=(TEXT, "axis of the line of sight", ("x", "y")[:axes]))


@cache
def bin_edges_rad() -> Floats:
    """Edges of the histogram's bins of the radial error, BINS + 1 of them; not to be written to."""
    octave, part = np.divmod(np.arange(kernels.BINS + 1), 1 << kernels.BINS_OCTAVE_BITS)
    squares = 2.0 ** (octave + kernels.BINS_LOWEST_OCTAVE) * (1.0 + part / (1 << kernels.BINS_OCTAVE_BITS))
    edges = np.sqrt(squares)
    edges.flags.writeable = False
    return np.asarray(edges)


def histogram_quantile(counts: NDArray[np.integer], share: float) -> float:
    """Quantile (rad) of binned radial errors; nan where nothing was counted.

    It is linear in the square inside a bin, which is 3 % wide.

    Args:
        counts: Samples in each bin of `bin_edges_rad`, shape (bins,).
        share: Share of the samples below the quantile, 0 to 1.
    """
    total = np.cumsum(counts)
    if not total[-1]:
        return math.nan
    wanted = share * float(total[-1])
    at = int(np.searchsorted(total, wanted))
    at = max(at, int(np.flatnonzero(counts)[0]))  # a share of 0 is the lower edge of the first bin in use
    below = float(total[at - 1]) if at else 0.0
    inside = (wanted - below) / float(counts[at])
    low, high = bin_edges_rad()[at : at + 2] ** 2
    return math.sqrt(low + inside * (high - low))


def histogram_beyond(counts: NDArray[np.integer], radius_rad: float) -> float:
    """Share of binned radial errors beyond a radius; nan where nothing was counted.

    It is linear in the square inside a bin.

    Args:
        counts: Samples in each bin of `bin_edges_rad`, shape (bins,).
        radius_rad: The radius; below 0 it counts as 0.
    """
    total = float(np.sum(counts))
    if not total:
        return math.nan
    edges = bin_edges_rad() ** 2
    below = np.concatenate([[0.0], np.cumsum(counts, dtype=float)])
    return 1.0 - float(np.interp(max(radius_rad, 0.0) ** 2, edges, below)) / total


def compile_in_background(of: Callable[[], PointingLoop]) -> Callable[[], None]:
    """Begin to compile the kernels of an ensemble in a process beside this one, if the cache lacks them.

    They are compiled by an example, the loop that ``of`` gives, on which they do not depend. The callable that is
    returned waits for the end.
    """
    if kernels.is_compiled(kernels.ensemble_loop):
        return lambda: None
    compiling.begins()
    return in_background(lambda: _one_sample(of()))


def _one_sample(loop: PointingLoop) -> None:
    """A sample of an ensemble with a controller that does nothing."""
    inputs, m = loop.axes + loop.mirror.axes + loop.axes, loop.mirror.actuators
    nothing = lti.StateSpace(np.zeros((0, 0)), np.zeros((0, inputs)), np.zeros((m, 0)), np.zeros((m, inputs)))
    p = arrays(loop, LoopController("nothing", nothing, np.zeros((0, m))), 0)
    kept = np.empty((0, 0, 0))
    kernels.ensemble_loop(p, start(loop, p, 0), reference(loop, 0, 1), kept, kept, kernels.UNSHIFTED)


@dataclass(frozen=True, slots=True)
class Span:
    """How long a run is, what is left out at its begin, and which random numbers it takes."""

    duration_s: float
    settle_s: float
    seed: int


def simulate(
    loop: PointingLoop,
    controller: LoopController,
    span: Span,
    runs: int,
    *,
    first_run: int = 0,
    threads: int | None = None,
    on_progress: Progress = lambda done, total, what: None,
    beat: Callable[[], None] = lambda: None,
) -> Ensemble:
    """Simulate many runs of a loop under a controller and take their statistics.

    They depend on the seed and the run's number alone, not on the threads. The spectrum is that of run 0 and its batch,
    nan where they are not among the runs. Memory does not grow with the length of the runs, and by 5 kB a run.

    Args:
        loop: The loop.
        controller: The controller of all its axes.
        span: How long a run is, what is left out at its begin, and the seed.
        runs: How many runs there are, 1 or more.
        first_run: Number of the first of them.
        threads: Threads to share them, by default one for each core.
        on_progress: Called with the runs that are done, their number and the controller's name.
        beat: Called between slices of compiled code, on the thread that runs them; ends the runs by raising.

    Raises:
        ValueError: For a controller that does not fit the loop, a run that ends before it has settled, and for less
            than one run.
    """
    case = Case(loop, controller)
    _refuse_none(runs)
    jobs = [partial(_together, [case], span, first, beat) for first in range(first_run, first_run + runs, LANES)]
    parts = in_threads(jobs, lambda done, _: on_progress(min(done * LANES, runs), runs, controller.name), threads)
    return _joined(case, span, [batch for (batch,) in parts], runs)


@dataclass(frozen=True, slots=True)
class Case:
    """A loop under a controller, and whether the ``spectrum`` of its residual is taken; else that is nan."""

    loop: PointingLoop
    controller: LoopController
    spectrum: bool = True


TOGETHER = 12
"""Cases, at most, that share what one of them has drawn."""

DRAWN_SAMPLES = 256
"""Control samples for which it is drawn at a time: a megabyte or two, which a processor keeps near."""


def simulate_cases(
    cases: Sequence[Case], span: Span, runs: int, on_done: Callable[[int, int], None] = lambda done, total: None
) -> list[Ensemble]:
    """Simulate each of the cases as `simulate` does, to the last bit, on all cores.

    Cases with the same disturbances draw them once.

    Args:
        cases: Loops, each under its controller.
        span: How long a run is, what is left out at its begin, and the seed.
        runs: How many runs each case has, 1 or more, from run 0 on.
        on_done: Called with the parts of the work that are done, and their number.

    Raises:
        ValueError: As `simulate` does.
    """
    _refuse_none(runs)
    alike: dict[Any, list[int]] = {}
    for number, case in enumerate(cases):
        alike.setdefault(_drawn_alike(case.loop), []).append(number)
    firsts, jobs, numbers = range(0, runs, LANES), [], []
    share = max(1, min(TOGETHER, -(-len(cases) * len(firsts) // (os.cpu_count() or 1))))
    for group in sorted(alike.values(), key=len, reverse=True):
        parts = -(-len(group) // share)
        for own in (group[part::parts] for part in range(parts)):
            for first in firsts:
                jobs.append(partial(_together, [cases[number] for number in own], span, first))
                numbers.append(own)
    found: dict[int, list[_Batch]] = {number: [] for number in range(len(cases))}
    for own, batches in zip(numbers, in_threads(jobs, on_done), strict=True):
        for number, batch in zip(own, batches, strict=True):
            found[number].append(batch)
    return [_joined(case, span, found[number], runs) for number, case in enumerate(cases)]


def _refuse_none(runs: int) -> None:
    if runs < 1:
        raise ValueError(f"an ensemble of {runs} runs has no statistics: ask for 1 run or more")


def _drawn_alike(loop: PointingLoop) -> tuple[Any, ...]:
    """What loops have in common that draw the same random numbers: the very same disturbances, clock and readings."""
    same = tuple(tuple(id(each) for each in several) for several in loop.disturbances)
    return (same, loop.timing.step_s, loop.timing.steps_per_sample, loop.axes, loop.mirror.axes)


@dataclass(frozen=True, slots=True)
class _Batch:
    state: kernels.EnsembleState
    psd: Floats


def control_samples(loop: PointingLoop, span: Span) -> tuple[int, int]:
    """Number of control samples of a run in all, and of those that settle.

    Args:
        loop: The loop, for its clock.
        span: How long a run is, and what is left out at its begin.

    Raises:
        ValueError: Nothing is left behind the settling time, or a time is not finite.
    """
    period = loop.timing.period_s
    samples = span.duration_s / period, span.settle_s / period
    if not all(map(math.isfinite, samples)):
        raise ValueError(f"a run of {span.duration_s:g} s that settles for {span.settle_s:g} s: give finite seconds")
    total, settle = map(round, samples)
    if not 0 <= settle < total:
        raise ValueError(
            f"a run of {span.duration_s:g} s has nothing left behind a settling time of {span.settle_s:g} s: "
            "make the run longer"
        )
    return total, settle


def _segment(loop: PointingLoop, span: Span) -> int:
    """Samples in a segment of the spectrum: a power of 2 that fits behind the settling time."""
    total, settle = control_samples(loop, span)
    return min(SLICE_SAMPLES, 1 << (total - settle).bit_length() - 1)


def _together(
    cases: Sequence[Case], span: Span, first_run: int, beat: Callable[[], None] = lambda: None
) -> list[_Batch]:
    """LANES runs of cases that draw alike, all of them over one slice of time and then over the next."""
    shaping = combined_shaping(cases[0].loop)
    advancing = [_Advancing(case, span, first_run, shaping) for case in cases]
    lead, total, settle = advancing[0], *control_samples(cases[0].loop, span)
    segment, at = _segment(cases[0].loop, span), 0
    drawing = _Drawing(lead.p, start(cases[0].loop, lead.p, first_run, shaping=shaping)) if len(cases) > 1 else None
    while at < total:
        beat()
        end = min(at + segment, total if at >= settle else settle)
        for each in advancing:
            each.begin(at, end, counting=at >= settle)
        some = DRAWN_SAMPLES if drawing else segment
        for first in range(at, end, some):
            last = min(first + some, end)
            drawn = drawing.next(last - first) if drawing else None
            for each in advancing:
                each.advance(first - at, last - at, drawn)
        for each in advancing:
            each.end()
        at = end
    return [each.batch for each in advancing]


class _Drawing:
    """What several cases share: the random numbers and disturbances of the samples to come."""

    def __init__(self, p: kernels.Ensemble, state: kernels.EnsembleState) -> None:
        axes, outputs = p.optics.shape
        self._p, self._state = p, state
        self._width = (axes + outputs + p.steps_per_sample * axes) * LANES
        self._drawn = np.empty(DRAWN_SAMPLES * self._width)

    def next(self, samples: int) -> Floats:
        """Those of so many samples, until it is called again."""
        kernels.draw_loop(self._p, self._state, samples, self._drawn)
        return self._drawn[: samples * self._width]


_NOTHING = np.empty((0, 0, 0))


class _Advancing:
    """LANES runs of a case on their way, segment by segment."""

    def __init__(self, case: Case, span: Span, first_run: int, shaping: Shaping) -> None:
        self.loop, self.p = case.loop, arrays(case.loop, case.controller, span.seed, shaping)
        self.state = start(case.loop, self.p, first_run, shaping=shaping)
        segment = _segment(case.loop, span)
        self._spectrum, self._segments = np.zeros((segment // 2 + 1, case.loop.axes)), 0
        wanted = case.spectrum and first_run == 0
        self._residual = np.empty((segment, case.loop.axes, LANES)) if wanted else _NOTHING
        self._reference, self._whole = _NOTHING, False

    def begin(self, at: int, end: int, *, counting: bool) -> None:
        """A segment from one control sample to another is to come."""
        if counting and not self.state.place[kernels.COUNTING]:
            self.state.place[kernels.COUNTING] = 1
            self.state.counts[:] = 0.0
        self._reference = reference(self.loop, at, end)
        self._whole = counting and self._residual.size > 0 and end - at == len(self._residual)

    def advance(self, first: int, last: int, drawn: Floats | None) -> None:
        """Some samples of the segment, with what is drawn for them."""
        state = self.state if drawn is None else self.state._replace(drawn=drawn)
        kept = self._residual[first:last] if self._whole else _NOTHING
        kernels.ensemble_loop(self.p, state, self._reference[first : last + 1], kept, _NOTHING, kernels.UNSHIFTED)

    def end(self) -> None:
        """The segment is over."""
        if self._whole:
            self._spectrum += _periodogram(self._residual, self.loop.timing.period_s)
            self._segments += 1

    @property
    def batch(self) -> _Batch:
        """What came out."""
        found = self._spectrum / self._segments if self._segments else np.full_like(self._spectrum, math.nan)
        return _Batch(self.state, found)


def _periodogram(residual: Floats, period_s: float) -> Floats:
    """One-sided spectrum (frequencies, axes) of one segment, Hann window, mean over the runs."""
    window = np.hanning(residual.shape[0] + 1)[:-1]
    found = np.zeros((residual.shape[0] // 2 + 1, residual.shape[1]))
    for axis in range(residual.shape[1]):
        transformed = np.fft.rfft(residual[:, axis, :] * window[:, None], axis=0)
        found[:, axis] = np.mean(np.abs(transformed) ** 2, axis=1)
    found *= 2.0 * period_s / max(float(np.sum(window**2)), 1e-300)  # a window of one sample is empty
    found[[0, -1]] /= 2.0
    return found


def _joined(case: Case, span: Span, parts: list[_Batch], runs: int) -> Ensemble:
    loop = case.loop
    total, settle = control_samples(loop, span)
    samples = total - settle
    steps = samples * loop.timing.steps_per_sample

    def by_run(field: str) -> Floats:
        return np.concatenate([getattr(b.state, field).reshape(-1, LANES).T for b in parts])[:runs]

    return Ensemble(
        name=case.controller.name,
        seconds=samples * loop.timing.period_s,
        rms_rad=np.sqrt(by_run("sum_square")[:, : loop.axes] / steps),
        mean_rad=by_run("sum")[:, : loop.axes] / samples,
        largest_rad=np.sqrt(by_run("largest")[:, 0]),
        histogram=np.concatenate([b.state.histogram for b in parts])[:runs],
        counts=by_run("counts"),
        freq_hz=np.asarray(np.fft.rfftfreq(_segment(loop, span), loop.timing.period_s), dtype=float),
        psd_rad2_hz=parts[0].psd,
        samples=samples,
        steps=steps,
        readings=-(-total // loop.optical.every) - -(-settle // loop.optical.every),
    )
