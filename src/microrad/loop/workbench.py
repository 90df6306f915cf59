"""A sampled loop around a mirror by itself: no mission, numbers in, margins, runs and statistics out."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from numbers import Integral
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from microrad.core import lti
from microrad.core.arrays import Floats
from microrad.core.progress import Progress
from microrad.core.units import LEAST, MOST
from microrad.loop import control, coupled_study
from microrad.loop.control.tuning import MARGIN
from microrad.loop.disturbance import NO_REFERENCE, Disturbance, SampledReference
from microrad.loop.pointing_loop import ensemble, traces
from microrad.loop.pointing_loop.design import design_plant, whole_plant
from microrad.loop.pointing_loop.linear import close, stationary
from microrad.loop.pointing_loop.loop import LoopController, PointingLoop, assemble, assemble_whole, decoupling
from microrad.loop.sensor import EXPOSURE, OpticalSensor, StrainGauge, delay_steps
from microrad.mirror import Mirror

Kind = Literal["PI", "PI + notch", "resonant damping", "disturbance observer", "LQG", "H-infinity"]

_OF_ONE_AXIS = {
    family.name: family
    for family in (
        control.PI,
        control.PI_NOTCH,
        control.RESONANT_DAMPING,
        control.DISTURBANCE_OBSERVER,
        control.LQG,
    )
}
_MOST_LATE = 2000  # plant steps
_OF_SEVERAL = {"LQG": control.LQG_OF_AXES, "H-infinity": control.H_INFINITY_OF_AXES}


@dataclass(frozen=True, slots=True, eq=False)
class Controller:
    """A discrete controller: x[k+1] = A x + B m + L (clip(v) - v), v = C x + D m.

    ``system`` has the error of each axis as the sensor reads it (rad) as inputs, with one axis the gauge's reading of
    the mirror (rad) behind it where it is used, and the command of each axis (V) as outputs. ``anti_windup`` is L,
    shape (states, axes): what a command that is cut off adds to the states. A loop of another rate than ``rate_hz``
    refuses it; None where that is not known.

    Example:
        ```python
        import microrad

        mirror = microrad.Mirror.of(50e-6, [1.0], [1 / 6000**2, 2 * 0.4 / 6000, 1.0])
        loop = microrad.Loop(mirror=mirror, rate_hz=10e3, sensor_noise_rad=0.2e-6)
        controller = microrad.Controller.pid(0.0, 2e6, rate_hz=10e3)
        print(loop.margins(controller).modulus)
        print(loop.simulate(controller, duration_s=0.1, reference_rad=[10e-6]).error_rad[-1])
        ```
    """

    name: str
    system: lti.StateSpace
    anti_windup: Floats
    rate_hz: float | None = None

    def __repr__(self) -> str:
        """What it is, without its matrices."""
        shape = f"{self.system.B.shape[1]} inputs, {self.system.C.shape[0]} outputs, {self.system.order} states"
        return f"<Controller {self.name!r}: {shape}>"

    @classmethod
    def pid(
        cls,
        proportional_v_rad: float,
        integral_v_rad_s: float = 0.0,
        derivative_v_s_rad: float = 0.0,
        *,
        rate_hz: float,
        derivative_filter_s: float = 0.0,
        axes: int = 1,
    ) -> "Controller":
        """The same PID on each axis, by backward differences, with conditioning against windup.

        Args:
            proportional_v_rad: Proportional gain (V/rad).
            integral_v_rad_s: Integral gain (V/(rad s)).
            derivative_v_s_rad: Derivative gain (V s/rad).
            rate_hz: Rate of the loop (Hz).
            derivative_filter_s: Time constant of the derivative's first-order filter (s).
            axes: Number of axes.

        Raises:
            ValueError: For a gain that is not finite, a rate not above 0, and no axis.
        """
        gains = (proportional_v_rad, integral_v_rad_s, derivative_v_s_rad, derivative_filter_s)
        if not all(abs(each) <= MOST for each in gains) or derivative_filter_s < 0.0:
            raise ValueError(f"gains {gains[:3]} and a filter of {derivative_filter_s} s make no PID: give finite ones")
        if not LEAST <= rate_hz <= MOST or not isinstance(axes, Integral) or axes < 1:
            raise ValueError(f"a PID of {axes} axes at {rate_hz} Hz: give one axis or more and a rate above 0 Hz")
        one = control.pid(control.Gains(*gains), 1.0 / rate_hz)
        parts = (one.A, one.B, one.C, one.D, control.anti_windup(one))
        A, B, C, D, windup = (np.asarray(np.kron(np.eye(axes), each), dtype=float) for each in parts)
        return cls("PID", lti.StateSpace(A, B, C, D), windup, rate_hz)


@dataclass(frozen=True, eq=False)
class TunedController:
    """What `tune` found: the controller, its values by name (SI units), and what its linear loop has.

    ``residual_rms_rad`` is by axis, with each hysteresis element at its slow gain. ``bound_by`` names what keeps it
    from being smaller: the modulus margin, or a bound of a value; empty inside all bounds.
    """

    controller: Controller
    values: Mapping[str, float]
    margins: control.LoopMargins | coupled_study.WholeMargins
    residual_rms_rad: Floats
    bound_by: tuple[str, ...]


@dataclass(frozen=True, kw_only=True, eq=False)
class Loop:
    """A mirror, its amplifier, a sensor of the line of sight and what disturbs it, sampled at one rate.

    The error of an axis is reference + vibration - mirror. Each number is per axis, angles are those of the mirror's
    outputs unless ``optics`` turns them. The sensor reads the error of ``sensor_delay_s`` ago with white noise of
    ``sensor_noise_rad`` a sample; a command is effective ``delay_s`` behind its sample. Drives count from the bias. A
    gauge reads the mirror itself.

    Args:
        mirror: The mirror.
        rate_hz: Control rate (Hz).
        vibration: What disturbs each axis, several added up; see `fit_spectrum`.
        sensor_noise_rad: Noise of the sensor (rad rms per sample).
        delay_s: Computation delay (s), a whole number of plant steps.
        sensor_delay_s: From the middle of the exposure to the delivery (s), a whole number of plant steps.
        gauge_noise_rad: Noise of a gauge (rad rms per sample); None without a gauge.
        drive_range_v: Least and largest drive (V).
        amplifier_bandwidth_hz: Bandwidth of a first-order amplifier (Hz).
        slew_v_s: Its largest rate (V/s).
        optics: Line-of-sight angles from the mirror's outputs, shape (axes, outputs), one or two axes; by
            default the outputs.
        steps_per_sample: Plant steps in a control period, 1 or more.

    Raises:
        ValueError: For a number outside of these; says which.

    Example:
        ```python
        import numpy as np
        import microrad

        plays = microrad.PrandtlIshlinskii(thresholds_v=(0.0, 1.0, 3.0), weights_rad_v=(40e-6, 6e-6, 4e-6))
        mirror = microrad.Mirror.of(plays, [1.0], [1 / 6000**2, 2 * 0.02 / 6000, 1.0])
        freq_hz = np.geomspace(0.1, 1000, 200)
        vibration = microrad.fit_spectrum(freq_hz, 160e-12 / (1 + freq_hz**2), convention="radial")
        loop = microrad.Loop(mirror=mirror, rate_hz=10e3, vibration=vibration, sensor_noise_rad=0.2e-6, delay_s=20e-6)
        tuned = microrad.tune(loop, "PI + notch")
        runs = loop.ensemble(tuned.controller, runs=64, duration_s=0.5, settle_s=0.1)
        print(tuned.margins.modulus, tuned.residual_rms_rad, runs.axis_rms_rad)
        ```
    """

    mirror: Mirror
    rate_hz: float
    vibration: Disturbance | Sequence[Disturbance] = ()
    sensor_noise_rad: float = 0.0
    delay_s: float = 0.0
    sensor_delay_s: float = 0.0
    gauge_noise_rad: float | None = None
    drive_range_v: tuple[float, float] = (-math.inf, math.inf)
    amplifier_bandwidth_hz: float = math.inf
    slew_v_s: float = math.inf
    optics: ArrayLike | None = None
    steps_per_sample: int = 10

    def __post_init__(self) -> None:
        """Check each number."""
        for name in ("rate_hz", "amplifier_bandwidth_hz", "slew_v_s"):
            value = getattr(self, name)
            if not LEAST <= value <= MOST and not (value == math.inf and name != "rate_hz"):
                raise ValueError(f"{name} of a loop is {value}: give a number above 0")
        if not isinstance(self.steps_per_sample, Integral) or self.steps_per_sample < 1:
            raise ValueError(
                f"a loop has {self.steps_per_sample} plant steps a sample: give a whole number, 1 or more, better 10"
            )
        low, high = self.drive_range_v
        if not low < 0.0 < high:
            raise ValueError(f"drive_range_v of a loop is ({low}, {high}) V: rest, 0 V, has to lie inside")
        if self.axes > 2:
            raise ValueError(
                f"a loop has {self.axes} line-of-sight angles and may have one or two: give optics of one or two rows"
            )
        if self.gauge_noise_rad is not None and self._optics.shape != (self.mirror.axes, self.mirror.axes):
            raise ValueError("a loop with a gauge needs one line-of-sight angle for each output of the mirror")
        _ = self.parts  # refuses what is wrong of delays and sensors

    def __repr__(self) -> str:
        """What it is, without its arrays."""
        return f"<Loop of {self.axes} axes at {self.rate_hz:g} Hz around mirror {self.mirror.name!r}>"

    @property
    def axes(self) -> int:
        """Number of line-of-sight axes."""
        return len(self._optics)

    @property
    def _optics(self) -> Floats:
        if self.optics is None:
            return np.eye(self.mirror.axes)
        found = np.atleast_2d(np.asarray(self.optics, dtype=float))
        if found.shape[1] != self.mirror.axes or not np.isfinite(found).all():
            raise ValueError(
                f"optics of a loop has shape {found.shape}: give finite numbers of shape (axes, {self.mirror.axes}), a "
                "row for each line-of-sight angle"
            )
        return found

    @cached_property
    def parts(self) -> PointingLoop:
        """The loop as the simulation takes it."""
        given = (self.vibration,) if isinstance(self.vibration, Disturbance) else tuple(self.vibration)
        period = 1.0 / self.rate_hz
        step = period / self.steps_per_sample
        for name in ("delay_s", "sensor_delay_s"):
            if not getattr(self, name) <= _MOST_LATE * step:
                raise ValueError(
                    f"{name} of a loop is {getattr(self, name)} s, more than {_MOST_LATE} plant steps of {step:g} s, "
                    "each of them a state: give a shorter one, or fewer steps per sample"
                )
        late = delay_steps("loop", self.delay_s, step, "it runs from the sample to its command")
        seen_late = delay_steps("sensor of the loop", self.sensor_delay_s, step, EXPOSURE)
        low, high = self.drive_range_v
        return PointingLoop(
            mirror=self.mirror,
            optics=self._optics,
            drive=control.Drive(low, high, self.amplifier_bandwidth_hz, self.slew_v_s, 0.0, 0.0),
            timing=control.Timing(period, self.steps_per_sample, late),
            disturbances=(given,) * self.axes,
            optical=OpticalSensor(self.sensor_noise_rad, math.inf, 0.0, 1, seen_late),
            gauge=None if self.gauge_noise_rad is None else StrainGauge(self.gauge_noise_rad, 0.0),
            references=(NO_REFERENCE,) * self.axes,
        )

    def margins(self, controller: Controller) -> control.LoopMargins | coupled_study.WholeMargins:
        """Margins of the linear loop, each hysteresis element at its slow gain.

        Of one axis the smallest of the loop cut at the command and at the sensor; of several those of all axes at once.

        Args:
            controller: The controller.

        Raises:
            ValueError: The loop is unstable, or the controller does not fit.
        """
        if self.axes == 1:
            return control.loop_margins(design_plant(self.parts), self._axis(controller))
        plant = whole_plant(self.parts, decoupling(self.parts))
        system = self._checked(controller)
        whole = control.WholeController(controller.name, system, controller.anti_windup)
        return coupled_study.whole_margins(plant, whole)

    def residual_rms_rad(self, controller: Controller) -> Floats:
        """Stationary rms error of each axis in the linear loop (rad), shape (axes,).

        Args:
            controller: The controller.

        Raises:
            ValueError: The loop is unstable, or the controller does not fit.
        """
        return np.asarray(np.sqrt(stationary(close(self.parts, self.assembled(controller))).error))

    def simulate(
        self, controller: Controller, duration_s: float, *, reference_rad: ArrayLike | None = None, seed: int = 0
    ) -> traces.PointingTrace:
        """One run from rest, with hysteresis, limits, delays and noise, at the control samples.

        Args:
            controller: The controller.
            duration_s: Length of the run (s).
            reference_rad: What the mirror is to follow at the control samples (rad), shape (samples,) or (samples,
                axes); nothing by default. The last sample holds on.
            seed: Seed of the random numbers.

        Raises:
            ValueError: For a controller or a reference that does not fit, and a run without a sample.
        """
        loop = self.parts
        if reference_rad is not None:
            wanted = np.asarray(reference_rad, dtype=float)
            wanted = wanted[:, None] if wanted.ndim == 1 else wanted
            if wanted.ndim != 2 or wanted.shape[1] != self.axes or not wanted.size or not np.isfinite(wanted).all():
                raise ValueError(
                    f"reference_rad has shape {np.shape(reference_rad)}: give finite samples of shape (samples, "
                    f"{self.axes})"
                )
            columns = tuple(SampledReference(column, loop.timing.period_s) for column in wanted.T)
            loop = replace(loop, references=columns)
        return traces.trace(loop, self.assembled(controller), ensemble.Span(duration_s, 0.0, seed))

    def ensemble(
        self,
        controller: Controller,
        runs: int,
        duration_s: float,
        *,
        settle_s: float = 0.0,
        seed: int = 0,
        on_progress: Progress = lambda done, total, what: None,
    ) -> ensemble.Ensemble:
        """Statistics of many runs, each from rest; run number n is the same whatever their number.

        Args:
            controller: The controller.
            runs: Number of runs, 1 or more; 64 are advanced side by side.
            duration_s: Length of a run (s).
            settle_s: What is left out at its begin (s).
            seed: Seed of the random numbers.
            on_progress: Called with the runs that are done, their number and what is done.

        Raises:
            ValueError: For a controller that does not fit, no run, and a run that ends before it has settled.
        """
        span = ensemble.Span(duration_s, settle_s, seed)
        return ensemble.simulate(self.parts, self.assembled(controller), span, runs, on_progress=on_progress)

    def assembled(self, controller: Controller) -> LoopController:
        """The controller on the drives of this loop, as the simulation takes it.

        Args:
            controller: The controller.

        Raises:
            ValueError: It does not fit, or reads a gauge that the loop lacks.
        """
        if self.axes == 1:
            axis = self._axis(controller)
            return assemble(axis.name, self.parts, axis)
        system = self._checked(controller)
        return assemble_whole(controller.name, self.parts, system, controller.anti_windup)

    def _axis(self, controller: Controller) -> control.AxisController:
        s = self._checked(controller)
        without = 2 - s.B.shape[1]  # a gauge that it does not read
        B, D = (np.pad(each, ((0, 0), (0, without))) for each in (s.B, s.D))
        return control.AxisController(controller.name, lti.StateSpace(s.A, B, s.C, D), controller.anti_windup)

    def _checked(self, controller: Controller) -> lti.StateSpace:
        if isinstance(controller, TunedController):
            raise TypeError("a tuned controller was given with what is known of it: give its .controller")
        rate = controller.rate_hz
        if rate is not None and abs(rate - self.rate_hz) > 1e-9 * self.rate_hz:
            raise ValueError(
                f"controller {controller.name!r} is made for {rate:g} Hz, and this loop has {self.rate_hz:g} Hz: make "
                "one for this rate"
            )
        s, axes, most = controller.system, self.axes, 2 if self.axes == 1 else self.axes
        fits = s.C.shape[0] == axes <= s.B.shape[1] <= most and controller.anti_windup.shape == (s.order, axes)
        if not fits:
            raise ValueError(
                f"controller {controller.name!r} has {s.B.shape[1]} inputs, {s.C.shape[0]} outputs and an anti-windup "
                f"of shape {controller.anti_windup.shape}: a loop of {axes} axes takes an error and gives a command "
                f"for each, and an anti-windup of shape ({s.order}, {axes})"
            )
        held = {"A": s.A, "B": s.B, "C": s.C, "D": s.D, "anti-windup": controller.anti_windup}
        for key, matrix in held.items():
            if not np.isfinite(matrix).all():
                raise ValueError(
                    f"controller {controller.name!r}: {key} holds a number that is not finite; look for a gain that is "
                    "nan or infinite"
                )
        return s


def tune(
    loop: Loop,
    kind: Kind = "LQG",
    *,
    modulus_margin: float = 0.5,
    seed: int = 0,
    on_progress: Progress = lambda done, total, what: None,
) -> TunedController:
    """Find the controller of a kind that leaves the least error in the linear loop, under a modulus margin.

    Args:
        loop: The loop, with vibration to work against.
        kind: "PI", "PI + notch", "resonant damping" (needs a gauge), "disturbance observer" or "LQG" for one axis;
            "LQG" or "H-infinity" for several.
        modulus_margin: Least distance of the loop gain from -1, above 0 and below 1.
        seed: Seed of the places where the search begins.
        on_progress: Called with the steps that are done, their number and what is done.

    Raises:
        ValueError: For a kind that this loop cannot have, a loop without vibration, and a margin that
            cannot be kept; says what the best one reaches.

    Example:
        ```python
        import numpy as np
        import microrad

        mirror = microrad.Mirror.of(50e-6, [1.0], [1 / 6000**2, 2 * 0.02 / 6000, 1.0])
        freq_hz = np.geomspace(0.1, 1000, 200)
        vibration = microrad.fit_spectrum(freq_hz, 160e-12 / (1 + freq_hz**2), convention="radial")
        loop = microrad.Loop(mirror=mirror, rate_hz=10e3, vibration=vibration, sensor_noise_rad=0.2e-6)
        tuned = microrad.tune(loop, "PI", modulus_margin=0.6)
        print(tuned.values, tuned.margins.bandwidth_hz, tuned.residual_rms_rad)
        ```
    """
    kinds = _OF_ONE_AXIS if loop.axes == 1 else _OF_SEVERAL
    if kind not in kinds:
        axes = "one axis" if loop.axes == 1 else f"{loop.axes} axes"
        raise ValueError(f"{kind!r} cannot be tuned for a loop of {axes}: choose one of {', '.join(kinds)}")
    if not 0.0 < modulus_margin < 1.0:
        raise ValueError(f"modulus_margin is {modulus_margin}: give a number above 0 and below 1, such as 0.5")
    if not loop.vibration:
        raise ValueError("the loop has no vibration, so that no controller is best: give it one, see fit_spectrum")
    asked = control.Specification(modulus_margin)
    if loop.axes == 1:
        found = control.tune(kinds[kind], [design_plant(loop.parts)], asked, seed=seed, on_progress=on_progress)
        made = Controller(kind, found.controller.system, found.controller.anti_windup, loop.rate_hz)
        return TunedController(made, found.values, found.margins, loop.residual_rms_rad(made), found.bound_by)
    whole, values = coupled_study.tuned_whole(kinds[kind], [whole_plant(loop.parts, decoupling(loop.parts))], asked)
    on_progress(1, 1, f"tune {kind}")
    made = Controller(kind, whole.system, whole.anti_windup, loop.rate_hz)
    margins = loop.margins(made)
    bound = (MARGIN,) if margins.modulus < 1.02 * modulus_margin else ()
    return TunedController(made, values, margins, loop.residual_rms_rad(made), bound)
