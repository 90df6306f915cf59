"""What an export is made of: controllers and mirrors as numbers with names and units, and recorded vectors."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from microrad.core import kernels, lti
from microrad.core.arrays import Floats
from microrad.core.errors import MicroradError

Indices = NDArray[np.integer]

OPTICAL_ERROR, GAUGE, READING, REFERENCE = "optical_error_rad", "gauge_rad", "reading_rad", "reference_rad"
"""Names of the inputs of a controller."""


class ExportError(MicroradError):
    """What cannot be exported or imported; the message says what, where, why and what to do."""

    page = "export"


@dataclass(frozen=True, slots=True)
class Signal:
    """An input of exported code: its identifier, how many numbers, unit and meaning.

    A number of a size beyond ``limit`` (SI) is taken for a fault of whatever delivered it.
    """

    name: str
    size: int
    unit: str
    meaning: str
    limit: float


@dataclass(frozen=True, slots=True)
class InverseLaw:
    """The inverse of hysteresis and creep at a control period, with the arrays of `kernels.Loop` under their names.

    ``by_difference``: the target's rate is the difference of two samples of the target; else the controller's linear
    part delivers it.
    """

    direct: Floats
    bouc_wen: Floats
    bouc_wen_actuator: Indices
    play_threshold: Floats
    play_weight: Floats
    play_actuator: Indices
    widening: Floats
    lag_keep: Floats
    lag_weight: Floats
    lag_actuator: Indices
    by_difference: bool


@dataclass(frozen=True, slots=True)
class AdaptiveLaw:
    """How an inverse of plays learns, with the arrays of `kernels.Ensemble` under their names.

    ``settings`` has a row for each actuator (kernels.CYCLE ...); ``threshold`` (V) and ``weight`` (rad/V) are those of
    the mirror's plays, those of actuator a from ``start[a]`` to the next.
    """

    settings: Floats
    threshold: Floats
    weight: Floats
    start: Indices


@dataclass(frozen=True, slots=True)
class Origin:
    """Where a design comes from: names in words, and the mission file that it was made from."""

    mission: str
    mission_sha256: str
    mirror: str


@dataclass(frozen=True, slots=True)
class FlightController:
    """A controller as it flies: x[k+1] = A x + B m + L (clip(v) - v), with m the ``inputs`` one behind the other.

    ``system`` has the outputs C x + D m: v by actuator (V); then, with an ``inverse``, its target by actuator (rad);
    then the target's rate by actuator (rad/s), unless the inverse takes it by difference; then, with ``forward``, what
    drives each of its elements. What the inverse makes of the target, and ``forward`` of its drives, is added to v; the
    sum is clipped to ``minimum_v`` and ``maximum_v`` and rounded to ``resolution_v`` (0: not rounded). With an
    ``adaptation`` the inverse's plays are those that are learnt, and the last outputs are readings less those that the
    targets make expect, by actuator (rad). Commands count from ``bias_v``, at the amplifier's input. ``margins`` are
    (name, value, unit).
    """

    name: str
    origin: Origin
    period_s: float
    inputs: tuple[Signal, ...]
    actuators: int
    system: lti.StateSpace
    anti_windup: Floats
    inverse: InverseLaw | None
    minimum_v: float
    maximum_v: float
    resolution_v: float
    bias_v: float
    margins: tuple[tuple[str, float, str], ...]
    forward: kernels.ForwardBank | None = None
    adaptation: AdaptiveLaw | None = None


@dataclass(frozen=True, slots=True)
class PlantUnit:
    """Amplifier and mirror at the plant's step: command (V, from the bias, held from step to step) to angle.

    ``optics`` (axes, outputs) turns the mirror's outputs into line-of-sight angles. ``follow`` is the share of the way
    to the command that the amplifier goes in a step, ``slew_step_v`` its most; ``bandwidth_hz`` (may be infinite) says
    where ``follow`` comes from. The mirror's outputs count in ``output_unit``, "rad" or "m"; what its elements put out
    counts in ``element_unit``, "rad", or "V" where elements have plain gains.
    """

    origin: Origin
    plant: kernels.Plant
    optics: Floats
    bandwidth_hz: float
    follow: float
    slew_step_v: float
    bias_v: float
    output_unit: str = "rad"
    element_unit: str = "rad"


@dataclass(frozen=True, slots=True)
class LoopUnit:
    """A closed loop: plant, controller, and what lies between them.

    Error = reference + disturbance - line of sight. The controller reads: with an input OPTICAL_ERROR, that error of
    ``optical_delay_steps`` plant steps ago, taken every ``optical_every`` samples while the radial error is within
    ``field_of_view_rad``, and the mirror's outputs (GAUGE); with an input READING, the line of sight. Readings are
    rounded to their resolution (0: not rounded). Commands leave ``delay_steps`` plant steps behind their sample.
    """

    plant: PlantUnit
    controller: FlightController
    steps_per_sample: int
    delay_steps: int
    optical_delay_steps: int
    optical_every: int
    field_of_view_rad: float
    optical_resolution_rad: float
    gauge_resolution_rad: float


@dataclass(frozen=True, slots=True)
class Vectors:
    """A run of the loop in the kernel as a controller sees it.

    ``inputs`` have the shape (samples, numbers), ``commands`` (samples, actuators), V. ``saturated`` is counted over
    all samples and actuators, ``rate_clamped`` over all samples and elements.
    """

    inputs: Floats
    commands: Floats
    saturated: int
    rate_clamped: int
