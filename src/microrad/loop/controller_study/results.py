"""What the designs leave: in theory and simulated, on each variant of the mirror, part by part and on sines."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from microrad.core.arrays import Floats
from microrad.core.progress import Progress
from microrad.loop.control import inverse
from microrad.loop.controller_study import parts
from microrad.loop.controller_study.designs import BASELINE, AnyDesign, Design
from microrad.loop.controller_study.scenario import BODY_POINTING, AnyScene, Scene
from microrad.loop.pointing_loop import ensemble, kernel_arrays
from microrad.loop.pointing_loop.linear import Stationary, close, residual_spectrum, stationary
from microrad.loop.pointing_loop.loop import LoopController, PointingLoop
from microrad.mirror import Variant
from microrad.mission.tables.fine_pointing import FinePointing

PROMISE = 1.5
"""How many times its linear rms a design may leave when it is simulated, before that figure is no promise."""

FEW_SAMPLES = 2_500
"""Control samples behind the settling in the runs of an `outlook`, at most: the rms of 64 runs to some 2 %."""


@dataclass(frozen=True, slots=True)
class Outlook:
    """Rms that a design leaves an axis: as it was tuned, linear, and simulated on the mission's mirror."""

    linear_rad: float
    simulated_rad: float

    @property
    def times(self) -> float:
        """How many times the linear rms is left when it is simulated."""
        return self.simulated_rad / self.linear_rad

    @property
    def holds(self) -> bool:
        """Whether the linear figure is a promise."""
        return self.times <= PROMISE

    def mark(self, accept: bool) -> str:
        """The word that a report sets beside the figure: "refused" where the linear one is no promise, else none.

        With `accept`, the user's word that it is to be taken all the same, "accepted" stands in place of "refused".
        """
        return "" if self.holds else "accepted" if accept else "refused"


@dataclass(frozen=True, slots=True)
class Residual:
    """What one controller leaves on one variant of the mirror: radial, at the line of sight.

    ``rms_interval_rad`` is the half width of the 99 % interval over the runs, infinite where there is but one.
    ``quantile_rad`` is the error that the mission's share of the time stays below; ``shares`` say how often each limit
    was met, by name, where it was. ``axis_rms_rad`` is about zero; ``radial_counts`` counts the control samples by
    radial error, in the bins of `pointing_loop.ensemble.bin_edges_rad`.
    """

    rms_rad: float
    rms_interval_rad: float
    axis_rms_rad: tuple[float, ...]
    axis_mean_rad: tuple[float, ...]
    radial_counts: NDArray[np.int64]
    quantile_rad: float
    largest_rad: float
    shares: dict[str, float]


@dataclass(frozen=True, slots=True)
class Verified:
    """A design with what it leaves: ``theory`` without hysteresis and limits, ``simulated`` by variant of the mirror.

    ``spectrum_rad2_hz`` (frequencies, axes) is of the simulated residual on the mission's mirror; ``predicted_rad2_hz``
    of the linear one, at the same frequencies.
    """

    design: AnyDesign
    theory: Stationary
    simulated: dict[str, Residual]
    spectrum_rad2_hz: Floats
    predicted_rad2_hz: Floats

    def meets(self, required_rad: float, variant: Variant = Variant.GIVEN) -> bool:
        """Whether the error's quantile stays within the requirement.

        Args:
            required_rad: Largest radial error that is allowed.
            variant: Variant of the mirror that it is judged on, the mission's own by default.
        """
        return self.simulated[variant].quantile_rad <= required_rad


@dataclass(frozen=True, slots=True)
class Part:
    """One line of the error budget: radial rms with this part alone, simulated without hysteresis, and in theory."""

    name: str
    rms_rad: float
    theory_rad: float


@dataclass(frozen=True, slots=True)
class Difference:
    """What a part changes when it alone is left out of everything: radial rms with it and without it."""

    name: str
    with_rad: float
    without_rad: float

    @property
    def added_rad(self) -> float:
        """Root of the difference of the squares, negative where the part helps."""
        square = self.with_rad**2 - self.without_rad**2
        return math.copysign(math.sqrt(abs(square)), square)


@dataclass(frozen=True, slots=True)
class ErrorBudget:
    """What makes up the residual of one controller: each source alone and together, and what the rest changes.

    ``together_rad`` is simulated without hysteresis; the root sum square of the parts has to come to it where the loop
    is linear. ``differences`` hold what hysteresis, limits, delay and quantisation change in the full loop.
    """

    controller: str
    parts: tuple[Part, ...]
    together_rad: float
    full_rad: float
    differences: tuple[Difference, ...]

    @property
    def combined_rad(self) -> float:
        """Root sum square of the parts: they are independent of each other."""
        return math.hypot(*(part.rms_rad for part in self.parts))

    @property
    def dominant(self) -> str:
        """The part, or difference, that makes up most of the residual."""
        sizes = {part.name: part.rms_rad for part in self.parts}
        sizes |= {d.name: d.added_rad for d in self.differences if d.name != parts.DELAY}
        return max(sizes, key=lambda name: sizes[name])

    @property
    def linear(self) -> bool:
        """Whether the parts combine to the whole within 10 %, hysteresis included."""
        return abs(self.combined_rad / self.full_rad - 1.0) <= 0.1


@dataclass(frozen=True, slots=True)
class Sine:
    """Fig. 6 and 8 under vibration and noise: axis error while tracking a sine on x, on one variant of the mirror."""

    controller: str
    variant: Variant
    freq_hz: float
    rms_rad: float
    quantile_rad: float


def span(f: FinePointing) -> ensemble.Span:
    """How long the mission's runs are."""
    return ensemble.Span(f.duration_s, f.settle_s, f.seed)


def verify(
    scene: AnyScene, designs: Sequence[AnyDesign], on_progress: Progress = lambda done, total, what: None
) -> tuple[Verified, ...]:
    """Simulate each design on each variant of the mirror, beside its linear theory.

    Args:
        scene: The mission's fine-pointing loop.
        designs: The designs, in the order that is wanted.
        on_progress: Called with the parts of the work that are done, their number and what is done.

    Raises:
        ValueError: The linear loop under a design is unstable.
    """
    loops = {variant: scene.on(variant) for variant in scene.has}
    cases = [
        _case(loop, d.controller, spectrum=variant == Variant.GIVEN) for d in designs for variant, loop in loops.items()
    ]
    f = scene.table
    runs = iter(ensemble.simulate_cases(cases, span(f), f.runs, _telling(on_progress, "simulating controllers")))
    return tuple(_verified(scene, d, {variant: next(runs) for variant in loops}) for d in designs)


def outlook(
    scene: Scene, designs: Sequence[Design], on_progress: Progress = lambda done, total, what: None
) -> tuple[Outlook, ...]:
    """Each design's linear figure beside one simulated with hysteresis, in one batch of shortened runs.

    Args:
        scene: The mission's fine-pointing loop.
        designs: The designs, in the order that is wanted.
        on_progress: Called with the parts of the work that are done, their number and what is done.
    """
    found = shortened(scene.table, scene.loop, [d.controller for d in designs], on_progress)
    return tuple(
        Outlook(d.tuned.residual_rms_rad, each.radial_rms_rad / math.sqrt(scene.loop.axes))
        for d, each in zip(designs, found, strict=True)
    )


def shortened(
    f: FinePointing,
    loop: PointingLoop,
    controllers: Sequence[LoopController],
    on_progress: Progress = lambda done, total, what: None,
) -> list[ensemble.Ensemble]:
    """Few and short runs of a loop under each controller, in one batch.

    Args:
        f: The mission's fine-pointing table, for the length of its runs and the seed.
        loop: The loop.
        controllers: Controllers of all its axes, in the order that is wanted.
        on_progress: Called with the parts of the work that are done, their number and what is done.
    """
    whole, runs = span(f), min(f.runs, kernel_arrays.LANES)
    few = replace(whole, duration_s=min(whole.duration_s, whole.settle_s + FEW_SAMPLES * loop.timing.period_s))
    cases = [_case(loop, controller) for controller in controllers]
    return list(ensemble.simulate_cases(cases, few, runs, _telling(on_progress, "simulating controllers")))


def _case(loop: PointingLoop, controller: LoopController, *, spectrum: bool = False) -> ensemble.Case:
    return ensemble.Case(loop, for_mirror(controller, loop), spectrum)


def for_mirror(controller: LoopController, loop: PointingLoop) -> LoopController:
    """The controller with its inverse, where it has one, made that of this loop's mirror.

    Args:
        controller: The controller of all axes.
        loop: The loop that it is to work in.
    """
    return controller if controller.inverse is None else replace(controller, inverse=inverse(loop.mirror))


def _telling(on_progress: Progress, what: str) -> Callable[[int, int], None]:
    return lambda done, total: on_progress(done, total, what)


def _verified(scene: AnyScene, design: AnyDesign, runs: dict[Variant, ensemble.Ensemble]) -> Verified:
    closed = close(scene.theory, design.controller)
    given = runs[Variant.GIVEN]
    inner = given.freq_hz[1:-1]
    predicted = np.full((given.freq_hz.size, scene.loop.axes), np.nan)
    if scene.loop.optical.every == 1:
        predicted[1:-1] = residual_spectrum(closed, inner)
    return Verified(
        design,
        stationary(closed),
        {name: residual(run, scene.table.quantile) for name, run in runs.items()},
        given.psd_rad2_hz,
        predicted,
    )


def residual(run: ensemble.Ensemble, quantile: float) -> Residual:
    """An ensemble's statistics as a record.

    Args:
        run: The ensemble.
        quantile: Share of the time, 0 to 1, that the error of the record stays below.
    """
    shares = {name: run.share(counter) for name, counter in ensemble.COUNTERS.items()}
    return Residual(
        run.radial_rms_rad,
        run.radial_rms_interval_rad(),
        tuple(float(v) for v in run.axis_rms_rad),
        tuple(float(v) for v in np.mean(run.mean_rad, axis=0)),
        run.histogram.sum(axis=0, dtype=np.int64),
        run.quantile_rad(quantile),
        float(np.max(run.largest_rad)),
        {name: share for name, share in shares.items() if share},
    )


def best(verified: Sequence[Verified]) -> Verified:
    """The design that leaves the smallest quantile on the mission's mirror, the baseline aside."""
    tuned = [v for v in verified if v.design.name != BASELINE]
    return min(tuned, key=lambda v: v.simulated[Variant.GIVEN].quantile_rad)


def error_budget(scene: AnyScene, of: Verified, on_progress: Progress = lambda done, total, what: None) -> ErrorBudget:
    """Split up the residual of a design: each source alone, all together, and what the rest of the loop adds.

    What is not a source of error (limits, quantisation, delay) is left out of the whole. All runs have the same seeds.
    The whole, with hysteresis and without, is what `verify` has simulated.

    Args:
        scene: The mission's fine-pointing loop.
        of: The design, simulated.
        on_progress: Called with the parts of the work that are done, their number and what is done.
    """
    fine = parts.without(scene.on(Variant.STRAIGHT), parts.QUANTISATION)
    names = parts.sources(fine)
    left_out = (parts.LIMITS, parts.QUANTISATION, parts.DELAY)
    alone = [parts.without(fine, *(other for other in names if other != name)) for name in names]
    fewer = [parts.without(scene.loop, name) for name in left_out]
    cases = [_case(loop, of.design.controller) for loop in (*alone, *fewer)]
    runs = ensemble.simulate_cases(cases, span(scene.table), scene.table.runs, _telling(on_progress, "error budget"))
    rms = [run.radial_rms_rad for run in runs]
    theory = of.theory.error_by_source
    lines = tuple(
        Part(name, value, math.sqrt(float(np.sum(theory[name]))) if name in theory else math.nan)
        for name, value in zip(names, rms[: len(names)], strict=True)
    )
    full, together = of.simulated[Variant.GIVEN].rms_rad, of.simulated[Variant.STRAIGHT].rms_rad
    without = {parts.HYSTERESIS: together, **dict(zip(left_out, rms[len(names) :], strict=True))}
    differences = tuple(Difference(name, full, value) for name, value in without.items())
    return ErrorBudget(of.design.name, lines, together, full, differences)


def _following_sine(loop: PointingLoop, amplitude_rad: float, freq_hz: float) -> PointingLoop:
    alone = parts.without(loop, parts.REFERENCE, parts.MISALIGNMENT, BODY_POINTING)
    first = replace(alone.references[0], sine_amplitude_rad=amplitude_rad, sine_freq_hz=freq_hz)
    return replace(alone, references=(first, *alone.references[1:]))


SINE_S, SINE_SETTLE_S = 1.4, 0.4
"""Length of a run that tracks a sine, and what is left out at its begin."""


def sines(
    scene: AnyScene, designs: Sequence[AnyDesign], on_progress: Progress = lambda done, total, what: None
) -> tuple[Sine, ...]:
    """The paper's sines (Fig. 6 and 8) on axis x, with vibration and sensor noise, for all controllers.

    Body pointing and point-ahead are left out: with them the sine would not fit into the stroke.

    Args:
        scene: The mission's fine-pointing loop, with amplitude and frequencies of the sines.
        designs: The designs, in the order that is wanted.
        on_progress: Called with the parts of the work that are done, their number and what is done.
    """
    f = scene.table
    cases, what = [], []
    for variant in (each for each in scene.has if each != Variant.STRAIGHT):
        loop = scene.on(variant)
        for design in designs:
            for freq in scene.sine_frequencies_hz:
                following = _following_sine(loop, scene.sine_amplitude_rad, freq)
                cases.append(_case(following, design.controller))
                what.append((design.name, variant, freq))
    short = ensemble.Span(SINE_S, SINE_SETTLE_S, f.seed)
    runs = ensemble.simulate_cases(
        cases, short, kernel_arrays.LANES, _telling(on_progress, "sines under vibration and noise")
    )
    return tuple(
        Sine(name, variant, freq, run.radial_rms_rad, run.quantile_rad(f.quantile))
        for (name, variant, freq), run in zip(what, runs, strict=True)
    )
