"""The linear models of a mission: mirror, sampled plant, controller and loop, with names, units and origin."""

from dataclasses import replace

import numpy as np

from microrad.core import lti
from microrad.export.choice import (
    OUTPUT_UNITS,
    Choice,
    CoupledChoice,
    PaperLoopChoice,
    PointingChoice,
    Source,
    flight_controller,
)
from microrad.export.matrices.forms import LinearModel, Port
from microrad.export.matrices.structure import without_copies, without_state
from microrad.export.records import ExportError, FlightController
from microrad.loop import control, sine_run
from microrad.loop.control import GAUGE, OPTICAL, RESIDUAL
from microrad.loop.control.analysis import moved, reachable
from microrad.loop.controller_study.designs import ADAPTIVE, IN_SERIES
from microrad.loop.pointing_loop.design import behind_filter, design_plant, driven_plant
from microrad.loop.pointing_loop.loop import ReferenceFilter
from microrad.loop.sensor import StrainGauge
from microrad.mirror import hysteresis
from microrad.mirror import model as mirror
from microrad.mirror.coupled import CoupledMirror

LINEAR_PART, MIRROR, SAMPLED_PLANT, CONTROLLER, LOOP = "linear_part", "mirror", "sampled_plant", "controller", "loop"
MIRROR_AT_REST = "mirror_at_rest"
"""Names of the models, valid as names of variables in MATLAB."""


def models(of: Source | Choice) -> tuple[LinearModel, ...]:
    """The linear models of a mission's mirror (see `choice.source`), or of a controller (`choice.choose`) and its loop.

    Angles are line-of-sight angles in the sampled plant, the controller and the loop, and the mirror file's own in the
    models of the mirror.

    Raises:
        ExportError: If the mission's loop cannot be built.
    """
    start = of if isinstance(of, Source) else of.source
    controller = None if isinstance(of, Source) else _controller(start, flight_controller(of))
    try:
        found = _coupled_mirror_models(start) if isinstance(start.mirror, CoupledMirror) else _mirror_models(start)
        if isinstance(of, Source) or controller is None:
            return tuple(found)
        if isinstance(of, CoupledChoice):
            plant, loop = _coupled_models(of, controller.system)
        else:
            plant, loop = _pointing_models(of) if isinstance(of, PointingChoice) else _paper_models(of)
        return (*found, plant, controller, loop)
    except ValueError as error:
        raise ExportError(f"{start.path}: {error}") from error


_STATES = {
    LINEAR_PART: "mode",
    MIRROR: "mirror_state",
    MIRROR_AT_REST: "mirror_state",
    SAMPLED_PLANT: "plant_state",
    CONTROLLER: "controller_state",
    LOOP: "loop_state",
}
"""What the states of each model are called, with their number behind it."""

_Units = dict[str, str]
"""Units of inputs or outputs by name."""


def _model(
    of: Source, name: str, meaning: str, system: lti.StateSpace, period_s: float, inputs: _Units, outputs: _Units
) -> LinearModel:
    states = tuple(Port(f"{_STATES[name]}_{i}", "1") for i in range(system.order))
    read, given = (tuple(Port(*each) for each in ports.items()) for ports in (inputs, outputs))
    return LinearModel(name, meaning, system, period_s, read, given, states, of.origin)


def _mirror_models(of: Source) -> list[LinearModel]:
    """The mirror's linear part, where it has one, and the mirror."""
    table, found = of.mirror, []
    assert not isinstance(table, CoupledMirror)
    if table.linear is not None:
        system, gain = mirror.linear_part(table.linear)
        meaning = (
            f"linear part of the mirror, divided by its gain at {table.linear.normalise_at_hz:g} Hz ({gain:.6g}); it "
            "takes what the hysteresis makes of the drive"
        )
        found.append(_model(of, LINEAR_PART, meaning, system, 0.0, {"hysteresis_rad": "rad"}, {"mirror_rad": "rad"}))
    made = mirror.from_mission(table, mirror.hysteresis_model(table, table.rate_limit_v_s, table.bias_v))
    meaning = f"mirror from drive to angle, its hysteresis at its slow gain; both count from rest at {table.bias_v:g} V"
    return [*found, _model(of, MIRROR, meaning, made.linear_loop, 0.0, {"drive_v": "V"}, {"mirror_rad": "rad"})]


def _coupled_mirror_models(of: Source) -> list[LinearModel]:
    """A mirror of several axes with gains in place of its hysteresis: slow ones, and those of small motions about rest.

    Hysteresis in a stiffness lowers the resonances of the first, and leaves those of the second.
    """
    given = of.mirror
    assert isinstance(given, CoupledMirror)
    own, counts = given.mirror, f"drives and outputs count from rest at {of.bias_v:g} V"
    inputs = {f"drive_v_{i}": "V" for i in range(own.actuators)}
    units = [OUTPUT_UNITS[output.quantity] for output in given.outputs]
    outputs = {f"mirror_{unit}_{i}": unit for i, unit in enumerate(units)}
    small = own.linear([hysteresis.rest_gain(element) for element in own.bank])
    return [
        _model(of, name, f"mirror from drives to outputs, {what}; {counts}", system, 0.0, inputs, outputs)
        for name, what, system in (
            (MIRROR, "its hysteresis at its slow gain", own.linear_loop),
            (MIRROR_AT_REST, "its hysteresis at the gain of small motions about rest", small),
        )
    ]


def _coupled_models(of: CoupledChoice, controller: lti.StateSpace) -> tuple[LinearModel, LinearModel]:
    """Sampled plant from all drives, and loop of all axes, for small motions about rest."""
    rest = of.scene.rest
    s, axes, period = driven_plant(rest), rest.axes, rest.timing.period_s
    r = reachable(s.A, s.B)
    s = lti.StateSpace(s.A[np.ix_(r, r)], s.B[r], s.C[:, r], s.D)
    residuals = np.argmax(np.abs(s.C[:axes]), axis=1)  # the states that hold the residuals: minus the angles
    for axis in np.argsort(residuals)[::-1]:
        s = without_state(s, int(residuals[axis]), -s.C[2 * axes + axis :][:1])
    plant = without_copies(lti.StateSpace(s.A, s.B, s.C[axes:], s.D[axes:]))
    returned = lti.StateSpace(plant.A, plant.B, -plant.C[:axes], -plant.D[:axes])
    sampled = replace(plant, C=np.roll(plant.C, axes, axis=0), D=np.roll(plant.D, axes, axis=0))
    angles, optical, back = (
        {f"{name}_{i}": "rad" for i in range(axes)}
        for name in ("line_of_sight_rad", "optical_error_rad", "returned_error_rad")
    )
    every = of.scene.loop.optical.every
    slow = "" if every == 1 else f"; a sensor that delivers every {every} samples counts as one of more delay"
    meaning = (
        "all axes for small motions about rest: computation delay, amplifier and mirror, its hysteresis at the gain of "
        f"such motions, at the control samples; the optical error as its sensor delivers it{slow}"
    )
    transfer = (
        "loop transfer L of all axes, cut at the optical sensor: controller, then plant, with the sign that makes the "
        "sensitivity the inverse of 1 + L"
    )
    commands = {f"command_v_{i}": "V" for i in range(rest.mirror.actuators)}
    return (
        _model(of.source, SAMPLED_PLANT, meaning, sampled, period, commands, {**angles, **optical}),
        _model(of.source, LOOP, transfer, without_copies(lti.series(controller, returned)), period, optical, back),
    )


def _paper_models(of: PaperLoopChoice) -> tuple[LinearModel, LinearModel]:
    """Sampled plant and loop of a controller of [control]."""
    setup, angle = of.setup, {"line_of_sight_rad": "rad"}
    plant = without_copies(control.sampled_plant(of.mirror, setup.drive, setup.timing))
    loop = without_copies(sine_run.sampled_loop(of.mirror, setup))
    behind = "computation delay, amplifier and mirror, its hysteresis at its slow gain, at the control samples"
    transfer = (
        "loop transfer L, controller and sampled plant in series; the closed loop is L / (1 + L). An inverse "
        "acts on the reference and is no part of it"
    )
    return (
        _model(of.source, SAMPLED_PLANT, behind, plant, setup.timing.period_s, {"command_v": "V"}, angle),
        _model(of.source, LOOP, transfer, loop, setup.timing.period_s, {"error_rad": "rad"}, angle),
    )


def axis_plant(of: PointingChoice) -> control.DesignPlant:
    """The plant that the chosen controller of one axis was designed for: its command and what comes of it alone.

    Outputs as in `control.DesignPlant`, without noise; the gauge reads the line of sight whether the loop has it or
    not. The filter of an inverse in series is part of it.
    """
    axis = of.scene.axis
    plant = design_plant(replace(axis, gauge=axis.gauge or StrainGauge(0.0, 0.0)))
    if of.controller.name in (IN_SERIES, ADAPTIVE):
        plant = behind_filter(plant, ReferenceFilter(of.scene.table.reference_filter_hz).discrete(plant.period_s))
    plant = moved(plant)
    newest = int(np.argmax(np.abs(plant.system.C[RESIDUAL])))  # the state that holds the residual: minus the angle
    system = without_state(plant.system, newest, -plant.system.C[GAUGE : GAUGE + 1])
    return replace(plant, system=without_copies(system), has_gauge=axis.gauge is not None)


def _pointing_models(of: PointingChoice) -> tuple[LinearModel, LinearModel]:
    """Sampled plant and loop of an axis of the fine-pointing loop."""
    plant, every, command = axis_plant(of), of.scene.loop.optical.every, {"axis_command_v": "V"}
    s, rows, outputs = plant.system, [GAUGE, OPTICAL], {"line_of_sight_rad": "rad", "optical_error_rad": "rad"}
    if plant.has_gauge:
        rows, outputs = [*rows, GAUGE], {**outputs, "gauge_rad": "rad"}
    slow = "" if every == 1 else f"; a sensor that delivers every {every} samples counts as one of more delay"
    behind = "reference filter, " if of.controller.name in (IN_SERIES, ADAPTIVE) else ""
    meaning = (
        f"one axis: computation delay, {behind}amplifier and mirror, its hysteresis at its slow gain, at the "
        f"control samples; the optical error as its sensor delivers it{slow}"
    )
    whole = lti.series(plant.from_command, of.tuned.controller.system)
    loop = without_copies(lti.StateSpace(whole.A, whole.B, -whole.C, -whole.D))
    transfer = (
        "loop transfer L of one axis, cut at its command: plant, then controller, with the sign that makes the "
        "closed loop 1 / (1 + L). An inverse counts as the reciprocal of the slow gain"
    )
    sampled = lti.StateSpace(s.A, s.B, s.C[rows], s.D[rows])
    return (
        _model(of.source, SAMPLED_PLANT, meaning, sampled, plant.period_s, command, outputs),
        _model(of.source, LOOP, transfer, loop, plant.period_s, command, {"returned_command_v": "V"}),
    )


def _controller(source: Source, of: FlightController) -> LinearModel:
    kinds, behind = {"command_v": "V"}, ""
    if of.inverse is not None:
        kinds["target_rad"] = "rad"
        behind = "; the inverse of the hysteresis, which is not linear, takes its targets behind it"
        if not of.inverse.by_difference:
            kinds["target_rate_rad_s"] = "rad/s"
    if of.adaptation is not None:
        kinds["unexpected_error_rad"] = "rad"
        behind += ", and learns from the readings' errors beside them: what they are off the expected ones"
    meaning = f"{of.name}, as it flies{behind}; its commands are clipped to {of.minimum_v:g} .. {of.maximum_v:g} V"
    inputs = {f"{each.name}_{i}": each.unit for each in of.inputs for i in range(each.size)}
    outputs = {f"{name}_{i}": unit for name, unit in kinds.items() for i in range(of.actuators)}
    made = _model(source, CONTROLLER, meaning, of.system, of.period_s, inputs, outputs)
    return replace(made, anti_windup=of.anti_windup)
