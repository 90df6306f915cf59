"""The linear models of a mission: mirror, sampled plant, controller and loop, with names, units and origin.

`write_mat`, `read_mat`, `json_text`, `to_control` and `from_control` carry them to other tools and back.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from microrad.core import lti
from microrad.export.choice import Choice, PointingChoice, TrackingChoice, flight_controller, origin
from microrad.export.matrices_files import from_control, json_text, read_mat, to_control, write_mat
from microrad.export.matrices_forms import (
    Forms,
    LinearModel,
    Port,
    TransferFunction,
    ZeroPoleGain,
    forms,
    transfer_function,
    zero_pole_gain,
)
from microrad.export.matrices_structure import without_copies, without_state
from microrad.export.records import ExportError, FlightController
from microrad.loop import control
from microrad.loop import sine_run as simulate
from microrad.loop.control import GAUGE, OPTICAL, RESIDUAL
from microrad.loop.control.analysis import moved
from microrad.loop.fine_loop.design import behind_filter, design_plant
from microrad.loop.fine_loop.loop import ReferenceFilter
from microrad.loop.fine_pointing import table
from microrad.loop.fine_pointing.designs import IN_SERIES
from microrad.loop.sensor import StrainGauge
from microrad.mirror import model as mirror
from microrad.mission.file import MissionFile

__all__ = [
    "CONTROLLER",
    "LINEAR_PART",
    "LOOP",
    "MIRROR",
    "SAMPLED_PLANT",
    "Forms",
    "LinearModel",
    "Port",
    "TransferFunction",
    "ZeroPoleGain",
    "forms",
    "from_control",
    "json_text",
    "models",
    "names",
    "read_mat",
    "to_control",
    "transfer_function",
    "write_mat",
    "zero_pole_gain",
]

LINEAR_PART, MIRROR, SAMPLED_PLANT, CONTROLLER, LOOP = "linear_part", "mirror", "sampled_plant", "controller", "loop"
"""Names of the models, valid as names of variables in MATLAB."""


def names(of: MissionFile | Choice) -> tuple[str, ...]:
    """The models that a mission has, or a chosen controller and what it stands in."""
    return tuple(_makers(of))


def models(of: MissionFile | Choice, wanted: Sequence[str] | None = None) -> tuple[LinearModel, ...]:
    """The linear models of a mission, or of a chosen controller (see `choice.choose`) and its loop.

    All of `names`, or the ``wanted`` ones. Angles are line-of-sight angles in the sampled plant, the controller and the
    loop, and the mirror file's own in the first two. Raises ExportError for a name that there is not, and for a mission
    whose loop cannot be built.
    """
    makers = _makers(of)
    for name in wanted or ():
        if name not in makers:
            raise ExportError(f"there is no model {name!r} here, but {', '.join(makers)}; choose one of these")
    try:
        return tuple(makers[name]() for name in (makers if wanted is None else wanted))
    except ExportError:
        raise
    except ValueError as error:
        raise ExportError(f"{_file(of).path}: {error}") from error


def _file(of: MissionFile | Choice) -> MissionFile:
    return of if isinstance(of, MissionFile) else of.file


def _makers(of: MissionFile | Choice) -> dict[str, Callable[[], LinearModel]]:
    file = _file(of)
    found: dict[str, Callable[[], LinearModel]] = {}
    if file.mission.mirror.linear is not None:
        found[LINEAR_PART] = lambda: _linear_part(file)
    found[MIRROR] = lambda: _mirror(file)
    if not isinstance(of, MissionFile):
        found[SAMPLED_PLANT] = lambda: _pointing_plant(of) if isinstance(of, PointingChoice) else _tracking_plant(of)
        found[CONTROLLER] = lambda: _controller(file, flight_controller(of))
        found[LOOP] = lambda: _pointing_loop(of) if isinstance(of, PointingChoice) else _tracking_loop(of)
    return found


def _states(count: int, of: str) -> tuple[Port, ...]:
    return tuple(Port(f"{of}_{i}", "1") for i in range(count))


# ----------------------------------------------------------------------------------------------------------- the mirror
def _linear_part(file: MissionFile) -> LinearModel:
    linear = file.mission.mirror.linear
    assert linear is not None  # one of the names only then
    system, gain = mirror.linear_part(linear)
    return LinearModel(
        name=LINEAR_PART,
        meaning=f"linear part of the mirror, divided by its gain at {linear.normalise_at_hz:g} Hz ({gain:.6g}); it "
        "takes what the hysteresis makes of the drive",
        system=system,
        period_s=0.0,
        inputs=(Port("hysteresis_rad", "rad"),),
        outputs=(Port("mirror_rad", "rad"),),
        states=_states(system.order, "mode"),
        origin=origin(file),
    )


def _mirror(file: MissionFile) -> LinearModel:
    m = file.mission.mirror
    made = mirror.from_mission(m, mirror.hysteresis_model(m, m.rate_limit_v_s, m.bias_v))
    system = made.linear_loop
    return LinearModel(
        name=MIRROR,
        meaning=f"mirror from drive to angle, its hysteresis at its slow gain; both count from rest at {m.bias_v:g} V",
        system=system,
        period_s=0.0,
        inputs=(Port("drive_v", "V"),),
        outputs=(Port("mirror_rad", "rad"),),
        states=_states(system.order, "mirror_state"),
        origin=origin(file),
    )


# ---------------------------------------------------------------------------------------------- plant, controller, loop
def _tracking_plant(of: TrackingChoice) -> LinearModel:
    system = without_copies(control.sampled_plant(of.mirror, of.setup.drive, of.setup.timing))
    return LinearModel(
        name=SAMPLED_PLANT,
        meaning="computation delay, amplifier and mirror, its hysteresis at its slow gain, at the control samples",
        system=system,
        period_s=of.setup.timing.period_s,
        inputs=(Port("command_v", "V"),),
        outputs=(Port("line_of_sight_rad", "rad"),),
        states=_states(system.order, "plant_state"),
        origin=origin(of.file),
    )


def _tracking_loop(of: TrackingChoice) -> LinearModel:
    system = without_copies(simulate.sampled_loop(of.mirror, of.setup))
    return LinearModel(
        name=LOOP,
        meaning="loop transfer L, controller and sampled plant in series; the closed loop is L / (1 + L). An inverse "
        "acts on the reference and is no part of it",
        system=system,
        period_s=of.setup.timing.period_s,
        inputs=(Port("error_rad", "rad"),),
        outputs=(Port("line_of_sight_rad", "rad"),),
        states=_states(system.order, "loop_state"),
        origin=origin(of.file),
    )


def axis_plant(of: PointingChoice) -> control.DesignPlant:
    """The plant that the chosen controller of one axis was designed for: its command and what comes of it alone.

    Outputs as in `control.DesignPlant`, without noise; the gauge reads the line of sight whether the loop has it or
    not. The filter of an inverse in series is part of it.
    """
    axis, m = of.scene.axis, of.file.mission
    plant = design_plant(replace(axis, gauge=axis.gauge or StrainGauge(0.0, 0.0)))
    if of.controller.name == IN_SERIES:
        plant = behind_filter(plant, ReferenceFilter(table(m).reference_filter_hz).discrete(plant.period_s))
    plant = moved(plant)
    newest = int(np.argmax(np.abs(plant.system.C[RESIDUAL])))  # the state that holds the residual: minus the angle
    system = without_state(plant.system, newest, -plant.system.C[GAUGE : GAUGE + 1])
    return replace(plant, system=without_copies(system), has_gauge=axis.gauge is not None)


def _pointing_plant(of: PointingChoice) -> LinearModel:
    plant, every = axis_plant(of), of.scene.loop.optical.every
    s, ports = plant.system, [Port("line_of_sight_rad", "rad"), Port("optical_error_rad", "rad")]
    rows = [GAUGE, OPTICAL]
    if plant.has_gauge:
        rows, ports = [*rows, GAUGE], [*ports, Port("gauge_rad", "rad")]
    slow = "" if every == 1 else f"; a sensor that delivers every {every} samples counts as one of more delay"
    behind = "reference filter, " if of.controller.name == IN_SERIES else ""
    return LinearModel(
        name=SAMPLED_PLANT,
        meaning=f"one axis: computation delay, {behind}amplifier and mirror, its hysteresis at its slow gain, at the "
        f"control samples; the optical error as its sensor delivers it{slow}",
        system=lti.StateSpace(s.A, s.B, s.C[rows], s.D[rows]),
        period_s=plant.period_s,
        inputs=(Port("axis_command_v", "V"),),
        outputs=tuple(ports),
        states=_states(s.order, "plant_state"),
        origin=origin(of.file),
    )


def _pointing_loop(of: PointingChoice) -> LinearModel:
    plant, axis = axis_plant(of), of.tuned.controller
    whole = lti.series(plant.from_command, axis.system)
    system = without_copies(lti.StateSpace(whole.A, whole.B, -whole.C, -whole.D))
    return LinearModel(
        name=LOOP,
        meaning="loop transfer L of one axis, cut at its command: plant, then controller, with the sign that makes the "
        "closed loop 1 / (1 + L). An inverse counts as the reciprocal of the slow gain",
        system=system,
        period_s=plant.period_s,
        inputs=(Port("axis_command_v", "V"),),
        outputs=(Port("returned_command_v", "V"),),
        states=_states(system.order, "loop_state"),
        origin=origin(of.file),
    )


def _controller(file: MissionFile, of: FlightController) -> LinearModel:
    kinds = [("command_v", "V")]
    if of.inverse is not None:
        kinds += [("target_rad", "rad"), *([] if of.inverse.by_difference else [("target_rate_rad_s", "rad/s")])]
        behind = "; the inverse of the hysteresis, which is not linear, takes its targets behind it"
    else:
        behind = ""
    return LinearModel(
        name=CONTROLLER,
        meaning=f"{of.name}, as it flies{behind}; its commands are clipped to {of.minimum_v:g} .. {of.maximum_v:g} V",
        system=of.system,
        period_s=of.period_s,
        inputs=tuple(Port(f"{each.name}_{i}", each.unit) for each in of.inputs for i in range(each.size)),
        outputs=tuple(Port(f"{name}_{i}", unit) for name, unit in kinds for i in range(of.actuators)),
        states=_states(of.system.order, "controller_state"),
        origin=origin(file),
        anti_windup=of.anti_windup,
    )
