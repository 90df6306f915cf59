"""The room's door: from a mission to one of its controllers, the loop around it, and a run of it in the kernel.

`choose` and `plant_unit` take the mission; what they give holds its parts, and no mission.
"""

import math
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path

import numpy as np

from microrad import mirror
from microrad.core import kernels, lti
from microrad.core.arrays import Floats
from microrad.core.progress import Progress
from microrad.core.units import format_limit, format_quantity
from microrad.export.linear_part.modes import minimal
from microrad.export.linear_part.sections import sections
from microrad.export.records import (
    GAUGE,
    OPTICAL_ERROR,
    READING,
    REFERENCE,
    AdaptiveLaw,
    ExportError,
    FlightController,
    InverseLaw,
    LoopUnit,
    Origin,
    PlantUnit,
    Signal,
    Vectors,
)
from microrad.link import arrival_of, tracking_light_w
from microrad.loop import control, controller_study, coupled_study, paper_cases, sine_run
from microrad.loop.paper_cases import PID, PID_WITH_INVERSE
from microrad.loop.pointing_loop.kernel_arrays import forward_arrays
from microrad.loop.pointing_loop.loop import LoopController
from microrad.loop.pointing_loop.traces import replay
from microrad.mirror import Variant, coupled, model
from microrad.mission.file import MissionFile
from microrad.mission.model import Scenario
from microrad.mission.tables.fine_pointing import FinePointing
from microrad.mission.tables.mirror import Mirror as MirrorTable

LOOPS = ("fine_pointing", "control")
"""Tables of a mission that describe a loop."""

OUTPUT_UNITS = {"displacement": "m", "angle": "rad"}
"""SI unit of each quantity that a mirror's output may be."""

INPUT_LIMIT_RAD = 0.1
"""Readings and references beyond it are taken for faults: no fine steering mirror or tracking sensor goes so far."""


@dataclass(frozen=True, slots=True)
class Source:
    """The mission file that something was made from, the mirror, and the bias that drives count from.

    ``mirror`` is the table of the mission's mirror, or the one of several axes that takes its place.
    """

    path: Path
    origin: Origin
    mirror: MirrorTable | coupled.CoupledMirror
    bias_v: float


@dataclass(frozen=True, slots=True)
class PointingChoice:
    """A controller of the fine-pointing loop, and what it leaves an axis."""

    source: Source
    scene: controller_study.Scene
    tuned: control.Tuned
    controller: LoopController
    left: controller_study.Outlook


@dataclass(frozen=True, slots=True)
class CoupledChoice:
    """A controller of the fine-pointing loop with a mirror of several axes in place of the mission's.

    ``controller`` is that of the design in the sections that fly: its slow poles are such that the last bit of a number
    in another form is 1e-12 of the command.
    """

    source: Source
    scene: coupled_study.CoupledScene
    design: coupled_study.CoupledDesign
    controller: LoopController
    left: controller_study.Outlook


@dataclass(frozen=True, slots=True)
class PaperLoopChoice:
    """A controller of the table [control]: one axis that tracks the scenario's sines, the paper's Fig. 6 and 8."""

    source: Source
    scenario: Scenario
    name: str
    mirror: model.Mirror
    setup: sine_run.Setup
    inverse: control.Inverse


Choice = PointingChoice | CoupledChoice | PaperLoopChoice


def names(table: FinePointing | None, of: MirrorTable) -> tuple[str, ...]:
    """The controllers of a mission.

    Args:
        table: Its fine-pointing loop, where it has one.
        of: Its mirror.
    """
    return (*(() if table is None else controller_study.offered(table, of)), PID, PID_WITH_INVERSE)


def source(file: MissionFile, given: coupled.CoupledMirror | None = None) -> Source:
    """What an export says of the mission that it was made from.

    Args:
        file: The mission.
        given: A mirror of several axes in place of the mission's.

    Raises:
        ExportError: Its actuators rest at different biases.
    """
    if given is None:
        table = file.mission.mirror
        return Source(file.path, Origin(file.mission.name, file.sha256, table.name), table, table.bias_v)
    biases = sorted({actuator.bias_v for actuator in given.actuators})
    if len(biases) > 1:
        raise ExportError(
            f"the actuators of {given.mirror.name!r} rest at {', '.join(f'{bias:g} V' for bias in biases)}, and "
            "exported code counts all commands from one bias: give all actuators the same, in the mirror file and in "
            "the amplifier"
        )
    return Source(file.path, Origin(file.mission.name, file.sha256, given.mirror.name), given, biases[0])


def choose(
    file: MissionFile, name: str, on_progress: Progress = lambda done, total, what: None
) -> PointingChoice | PaperLoopChoice:
    """A controller of a mission, tuned where it belongs to the fine-pointing loop.

    Args:
        file: The mission.
        name: One of its `names`.
        on_progress: Is told what is being tuned.

    Raises:
        ExportError: The mission has no such controller, or it cannot be built on the mission's mirror.
    """
    m, has = file.mission, names(file.mission.fine_pointing, file.mission.mirror)
    if name not in has:
        raise ExportError(f"{file.path} has no controller {name!r}; it has: {'; '.join(has)}")
    try:
        mirrors = mirror.of(m)
        if name in (PID, PID_WITH_INVERSE):
            return _paper_loop(source(file), paper_cases.of(m, mirrors), name)
        scene = controller_study.scene(file, mirrors, tracking_light_w(file), arrival_of(file))
        ((design, left),) = controller_study.design_and_promise(scene, on_progress, only=(name,))
        return PointingChoice(source(file), scene, design.tuned, design.controller, left)
    except ValueError as error:
        raise ExportError(f"{file.path}: {error}") from error


def choose_coupled(
    file: MissionFile, given: coupled.CoupledMirror, name: str, on_progress: Progress = lambda done, total, what: None
) -> CoupledChoice:
    """A controller of a mission's fine-pointing loop for a mirror of several axes.

    Args:
        file: The mission.
        given: The mirror, which takes the place of the mission's.
        name: One of `coupled_study.names`.
        on_progress: Is told what is being tuned.

    Raises:
        ExportError: The mission has no such controller, it cannot be built on the mirror, or the actuators rest at
            different biases.
    """
    of = source(file, given)
    try:
        scene = coupled_study.scene(file, given, tracking_light_w(file), arrival_of(file))
        found, (left,) = coupled_study.design_and_promise(scene, on_progress, only=(name,))
        (design,) = found.made
    except ValueError as error:
        raise ExportError(f"{file.path}: {error}") from error
    chosen = CoupledChoice(of, scene, design, design.controller, left.worst)
    form, at = sections(flight_controller(chosen)), _looked_at(_whole_controller(chosen))
    places = np.concatenate([np.arange(each.start, each.stop) for each in at.values()])
    B, D = (np.zeros((len(m), design.controller.system.B.shape[1])) for m in (form.B, form.D))
    B[:, places], D[:, places] = form.B, form.D
    sectioned = replace(design.controller, system=lti.StateSpace(form.A, B, form.C, D), anti_windup=form.L)
    return replace(chosen, controller=sectioned)


def promised(choice: Choice, accept: bool = False) -> controller_study.Outlook | None:
    """What a controller of the fine-pointing loop leaves, refused where its linear figure is no promise.

    The loop of [control] has no such figure: None.

    Args:
        choice: The controller.
        accept: Whether a figure that the simulation does not bear out is let pass.

    Raises:
        ExportError: Where the simulated residual is more than `controller_study.PROMISE` times the linear one, unless
            accepted.
    """
    if isinstance(choice, PaperLoopChoice):
        return None
    if not (choice.left.holds or accept):
        raise ExportError(_broken(choice))
    return choice.left


def _broken(choice: PointingChoice | CoupledChoice) -> str:
    left = choice.left
    found, said = rms_text(left.simulated_rad), rms_text(left.linear_rad)
    times = format_limit(left.times, "", least=True)  # never rounded onto the most
    return (
        f"{choice.source.path}: {choice.controller.name} leaves {found} on the mission's mirror, simulated with its "
        f"hysteresis: {times} times the {said} of linear theory, where {controller_study.PROMISE:g} times "
        "is the most. Choose another controller by the simulated figures of microrad design, or write this one all "
        "the same with --accept."
    )


def rms_text(rad: float) -> str:
    """An rms of one axis in words."""
    return f"{format_quantity(rad, 'rad', 4)} rms an axis"


def _paper_loop(of: Source, cases: paper_cases.PaperCases, name: str) -> PaperLoopChoice:
    plant = cases.mirrors.line_of_sight[Variant.GIVEN].plant
    inverse = control.inverse(plant) if name == PID_WITH_INVERSE else control.no_feedforward(plant)
    return PaperLoopChoice(of, cases.scenario, name, plant, cases.setup, inverse)


# ------------------------------------------------------------------------------------------------------ the controller
def flight_controller(choice: Choice) -> FlightController:
    """The chosen controller as it flies, without inputs and modes that do nothing.

    A design that holds a model of its plant may have a mode that nothing drives or no output shows.
    """
    try:
        return minimal(trimmed(_whole_controller(choice)))
    except ValueError as error:  # gains of [control] under which the loop is unstable
        raise error if isinstance(error, ExportError) else ExportError(f"{choice.source.path}: {error}") from error


def _whole_controller(choice: Choice) -> FlightController:
    return _paper_controller(choice) if isinstance(choice, PaperLoopChoice) else _pointing_controller(choice)


def columns(inputs: tuple[Signal, ...]) -> dict[str, slice]:
    """Where each of the signals stands among the inputs."""
    ends = np.cumsum([0] + [each.size for each in inputs])
    return {each.name: slice(int(a), int(b)) for each, (a, b) in zip(inputs, pairwise(ends), strict=True)}


def _looked_at(of: FlightController) -> dict[str, slice]:
    s = of.system
    return {name: at for name, at in columns(of.inputs).items() if np.any(s.B[:, at]) or np.any(s.D[:, at])}


def trimmed(of: FlightController) -> FlightController:
    """The controller without the signals that it does not look at."""
    s, kept = of.system, _looked_at(of)
    places = np.concatenate([np.arange(at.start, at.stop) for at in kept.values()])
    return replace(
        of,
        inputs=tuple(each for each in of.inputs if each.name in kept),
        system=lti.StateSpace(s.A, s.B[:, places], s.C, s.D[:, places]),
    )


def inverse_law(of: control.Inverse, period_s: float, by_difference: bool) -> InverseLaw:
    """An inverse of hysteresis and creep, sampled at a control period, as arrays for exported code.

    Args:
        of: The inverse as it was designed.
        period_s: The control period in seconds.
        by_difference: Whether the target's rate is the difference of two samples; else the controller's linear part
            gives it.
    """
    arrays = {key.removeprefix("inverse_"): value for key, value in control.inverse_arrays(of, period_s).items()}
    return InverseLaw(**arrays, by_difference=by_difference)


def adaptive_law(of: control.Adaptation | None, period_s: float) -> AdaptiveLaw | None:
    """How an inverse learns, as arrays for exported code; None where it does not.

    Args:
        of: The adaptation as it was designed.
        period_s: The control period in seconds.
    """
    if of is None:
        return None
    arrays = control.adaptive_arrays(of, period_s)
    return AdaptiveLaw(
        *(arrays[key] for key in ("adaptive", "adaptive_threshold", "adaptive_weight", "adaptive_start"))
    )


def _margins(of: control.LoopMargins) -> tuple[tuple[str, float, str], ...]:
    return (
        ("modulus margin", of.modulus, ""),
        ("gain margin", 20.0 * math.log10(of.gain_up), "dB"),
        ("phase margin", math.degrees(of.phase_rad), "deg"),
        ("delay margin", of.delay_s, "s"),
    )


def _margins_of_all(of: coupled_study.WholeMargins) -> tuple[tuple[str, float, str], ...]:
    return (
        ("modulus margin of all axes", of.modulus, ""),
        ("disk margin of all axes", of.disk.disk, ""),
        ("bandwidth", of.bandwidth_hz, "Hz"),
    )


def _pointing_controller(choice: PointingChoice | CoupledChoice) -> FlightController:
    loop, made = choice.scene.loop, choice.controller
    if isinstance(choice, CoupledChoice):
        margins = _margins_of_all(choice.design.margins)
    else:
        margins = (*_margins(choice.tuned.margins), ("bandwidth", choice.tuned.margins.bandwidth_hz, "Hz"))
    period = loop.timing.period_s
    error = "line-of-sight error (wanted less actual)"
    inputs = (
        Signal(OPTICAL_ERROR, loop.axes, "rad", f"{error} from the optical sensor, by axis", INPUT_LIMIT_RAD),
        Signal(GAUGE, loop.mirror.axes, "rad", "strain gauge's reading of the mirror, by output", INPUT_LIMIT_RAD),
        Signal(REFERENCE, loop.axes, "rad", f"known part of the {error}, by axis", INPUT_LIMIT_RAD),
    )
    return FlightController(
        name=made.name,
        origin=choice.source.origin,
        period_s=period,
        inputs=inputs,
        actuators=loop.mirror.actuators,
        system=made.system,
        anti_windup=made.anti_windup,
        inverse=None if made.inverse is None else inverse_law(made.inverse, period, by_difference=False),
        minimum_v=loop.drive.minimum_v,
        maximum_v=loop.drive.maximum_v,
        resolution_v=loop.drive.drive_resolution_v,
        bias_v=choice.source.bias_v,
        margins=margins,
        forward=None if made.forward is None else forward_arrays(made.forward, loop.mirror.actuators, period),
        adaptation=adaptive_law(made.adaptation, period),
    )


def _paper_controller(choice: PaperLoopChoice) -> FlightController:
    setup, s, axes = choice.setup, choice.setup.controller, choice.mirror.axes
    inverse = None
    D = np.hstack([-s.D, s.D])
    C = s.C
    if choice.name == PID_WITH_INVERSE:
        inverse = inverse_law(choice.inverse, setup.timing.period_s, by_difference=True)
        D = np.vstack([D, np.hstack([np.zeros((axes, axes)), np.eye(axes)])])  # the target is the reference
        C = np.vstack([C, np.zeros((axes, s.order))])
    return FlightController(
        name=choice.name,
        origin=choice.source.origin,
        period_s=setup.timing.period_s,
        inputs=(
            Signal(READING, axes, "rad", "line of sight as the mirror's sensor reads it", INPUT_LIMIT_RAD),
            Signal(REFERENCE, axes, "rad", "wanted line of sight", INPUT_LIMIT_RAD),
        ),
        actuators=choice.mirror.actuators,
        system=lti.StateSpace(s.A, np.hstack([-s.B, s.B]), C, D),
        anti_windup=control.anti_windup(s),
        inverse=inverse,
        minimum_v=setup.drive.minimum_v,
        maximum_v=setup.drive.maximum_v,
        resolution_v=setup.drive.drive_resolution_v,
        bias_v=choice.source.bias_v,
        margins=_margins(sine_run.margins(choice.mirror, setup)),
    )


# ---------------------------------------------------------------------------------------------------- plants and loops
def plant_unit(file: MissionFile, loop: str, given: coupled.CoupledMirror | None = None) -> PlantUnit:
    """Amplifier and mirror of a mission, at the plant step of one of its loops.

    Args:
        file: The mission.
        loop: One of `LOOPS`.
        given: A mirror of several axes in place of the mission's; it stands in the fine-pointing loop.

    Raises:
        ExportError: The mission has no such loop, it cannot be built, or not with this mirror.
    """
    if loop not in LOOPS or (loop == LOOPS[0] and file.mission.fine_pointing is None):
        raise ExportError(f"{file.path} has no loop {loop!r}: one of {', '.join(LOOPS)} that is a table of the mission")
    if given is not None and loop != LOOPS[0]:
        raise ExportError(
            f"the loop {loop!r} is of one axis, and {given.mirror.name!r} is a mirror of several: take {LOOPS[0]}"
        )
    try:
        if given is not None:
            made = coupled_study.scene(file, given, tracking_light_w(file), arrival_of(file)).loop
            return _plant_unit(source(file, given), made.mirror, made.optics, made.drive, made.timing)
        mirrors = mirror.of(file.mission)
        if loop == LOOPS[0]:
            made = controller_study.scene(file, mirrors, tracking_light_w(file), arrival_of(file)).loop
            return _plant_unit(source(file), made.mirror, made.optics, made.drive, made.timing)
        one = _paper_loop(source(file), paper_cases.of(file.mission, mirrors), PID)
        return _plant_unit(one.source, one.mirror, np.eye(one.mirror.axes), one.setup.drive, one.setup.timing)
    except ValueError as error:
        raise ExportError(f"{file.path}: {error}") from error


def _plant_unit(
    of: Source, mirror: model.Mirror, optics: Floats, drive: control.Drive, timing: control.Timing
) -> PlantUnit:
    unit = PlantUnit(
        of.origin,
        model.discretise(mirror, timing.step_s),
        optics,
        drive.bandwidth_hz,
        control.amplifier_factor(drive, timing.step_s),
        drive.slew_v_s * timing.step_s,
        of.bias_v,
    )
    if not isinstance(of.mirror, coupled.CoupledMirror):
        return unit
    quantities = {output.quantity for output in of.mirror.outputs}
    if len(quantities) > 1:
        raise ExportError(
            f"the outputs of {of.mirror.mirror.name!r} are displacements and angles, and a unit shows them as one "
            "array of one unit: leave the angles out of the mirror file, the line of sight takes nothing from them"
        )
    return replace(unit, output_unit=OUTPUT_UNITS[quantities.pop()], element_unit="V")


def loop_unit(choice: Choice) -> LoopUnit:
    """The chosen controller with the loop around it; sensors without their noise."""
    made = flight_controller(choice)
    if not isinstance(choice, PaperLoopChoice):
        loop, optical = choice.scene.loop, choice.scene.loop.optical
        plant = _plant_unit(choice.source, loop.mirror, loop.optics, loop.drive, loop.timing)
        gauge_rad = 0.0 if loop.gauge is None else loop.gauge.resolution_rad
        sensors = (optical.delay_steps, optical.every, optical.field_of_view_rad, optical.resolution_rad, gauge_rad)
        timing = loop.timing
    else:
        drive, timing = choice.setup.drive, choice.setup.timing
        plant = _plant_unit(choice.source, choice.mirror, np.eye(choice.mirror.axes), drive, timing)
        sensors = (0, 1, math.inf, drive.sensor_resolution_rad, 0.0)  # one that is read at each sample, without delay
    return LoopUnit(plant, made, timing.steps_per_sample, timing.delay_steps, *sensors)


# ------------------------------------------------------------------------------------------------------------- vectors
def vectors(choice: Choice, samples: int) -> Vectors:
    """A run of the chosen loop in the kernel, from rest, with what its controller read and commanded.

    The fine-pointing loop runs in its mission's jitter (run 0 of its seed). The loop of [control] tracks the fastest
    sine that the scenario has for an inverse.

    Args:
        choice: The controller.
        samples: Length of the run, in control periods.
    """
    if not isinstance(choice, PaperLoopChoice):
        run = replay(choice.scene.loop, choice.controller, samples, choice.scene.table.seed)
        saturated, clamped = (int(run.counts[c]) for c in (kernels.COUNT_SATURATED, kernels.COUNT_INVERSE_CLAMPED))
        found = Vectors(run.inputs, run.commands, saturated, clamped)
    else:
        found = _paper_vectors(choice, samples)
    kept = _looked_at(_whole_controller(choice)).values()
    return replace(found, inputs=np.hstack([found.inputs[:, at] for at in kept]))


def _paper_vectors(choice: PaperLoopChoice, samples: int) -> Vectors:
    scenario, setup = choice.scenario, choice.setup
    time: Floats = np.arange(samples, dtype=float) * setup.timing.period_s
    reference = scenario.amplitude_rad * np.sin(2.0 * np.pi * max(scenario.inverse_frequencies_hz) * time)[:, None]
    trace = sine_run.track(choice.name, choice.mirror, setup, choice.inverse, reference, slice(0, samples))
    resolution, reading = setup.drive.sensor_resolution_rad, trace.output_rad
    if resolution > 0.0:
        reading = np.floor(reading / resolution + 0.5) * resolution
    counts = trace.counts
    return Vectors(np.hstack([reading, reference]), trace.command_v, counts.saturated, counts.inverse_clamped)
