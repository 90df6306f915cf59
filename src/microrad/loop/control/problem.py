"""What a controller of one axis is designed for, and what a design is: plants and controllers as discrete matrices."""

import functools
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, TypeVar

from microrad.core import lti
from microrad.core.arrays import Floats

_Answer = TypeVar("_Answer")
_Plant = TypeVar("_Plant")

_KEPT = 4
"""Plants whose answers are kept: one for each axis of a loop, and what a design makes of one in between."""

RESIDUAL, OPTICAL, GAUGE = range(3)
"""Outputs of a design plant; a controller's inputs are the last two, in this order."""


@dataclass(frozen=True, slots=True)
class DesignPlant:
    """One axis as its controller sees it: discrete at the control period, with every delay inside.

    ``system`` has the inputs command (V), then independent white sequences of unit variance: first ``disturbances`` of
    them that drive the disturbance, then the optical sensor's noise, then the gauge's. Its outputs are the residual
    d - y (rad), the same as the optical sensor delivers it (late and noisy), and the gauge's reading of y (noisy). No
    output depends on the command of its own sample. ``gain_rad_v`` is the slow gain from command to y; a plant without
    a gauge (or without an optical sensor) has a zero row there, and ``has_gauge`` (``has_optical``) is false.
    """

    period_s: float
    system: lti.StateSpace
    disturbances: int
    gain_rad_v: float
    has_optical: bool = True
    has_gauge: bool = True

    @property
    def from_command(self) -> lti.StateSpace:
        """Command (V) to optical and gauge readings, without noise: what the loop gain is made of."""
        s = self.system
        return lti.StateSpace(s.A, s.B[:, :1], s.C[OPTICAL:], s.D[OPTICAL:, :1])


@dataclass(frozen=True, slots=True)
class WholePlant:
    """Several axes that act on each other, as their controllers see them: discrete, with every delay inside.

    ``system`` has the inputs command of each axis (V), then independent white sequences of unit variance: first
    ``disturbances`` of them, then the optical sensor's noise by axis. Its outputs are the residuals of all axes (rad),
    then the same as the optical sensor delivers them. ``gain_rad_v`` is the slow gain of each axis from its own
    command, decoupled from the others.
    """

    period_s: float
    system: lti.StateSpace
    axes: int
    disturbances: int
    gain_rad_v: float


def once_per_plant(of: Callable[[_Plant], _Answer]) -> Callable[[_Plant], _Answer]:
    """Let a function keep its last answers: a search asks the same of a few plants for each of its candidates."""
    last: dict[int, tuple[_Plant, _Answer]] = {}  # a plant that is kept keeps its identity

    @functools.wraps(of)
    def asked(plant: _Plant) -> _Answer:
        kept = last.get(id(plant))
        if kept is None or kept[0] is not plant:
            last[id(plant)] = kept = (plant, of(plant))
            while len(last) > _KEPT:
                last.pop(next(iter(last)), None)
        return kept[1]

    return asked


@dataclass(frozen=True, slots=True)
class AxisController:
    """A controller of one axis: x[k+1] = A x + B m + L (clip(v) - v), v = C x + D m.

    ``system`` has the inputs m: line-of-sight error from the optical sensor (rad; the command rises with it), and the
    gauge's reading of the mirror (rad), a zero column where a design does not use it. Output: command (V).
    ``anti_windup`` is L, shape (states, 1).
    """

    name: str
    system: lti.StateSpace
    anti_windup: Floats


@dataclass(frozen=True, slots=True)
class WholeController:
    """A controller of all axes, as `AxisController`: from the optical error of each axis (rad) to its command (V)."""

    name: str
    system: lti.StateSpace
    anti_windup: Floats


@dataclass(frozen=True, slots=True)
class Specification:
    """What a design has to respect: least modulus margin min |1 + L|, and least bandwidth (Hz; 0 asks for none).

    The bandwidth is the lowest frequency at which the sensitivity |S| reaches 1 (0 dB).
    """

    modulus_margin: float
    bandwidth_hz: float = 0.0


@dataclass(frozen=True, slots=True)
class Parameter:
    """One number that a design is tuned by: bounds in SI units, searched on a logarithmic scale where ``log``.

    ``gentle`` is the value with which the controller acts least (the lowest gain, no notch), the least one without it:
    where the residual hardly tells, a tuning goes towards it.
    """

    name: str
    unit: str
    least: float
    most: float
    log: bool = True
    gentle: float | None = None


@dataclass(frozen=True, slots=True)
class Family:
    """A kind of controller: the parameters it is tuned by for a plant, and how it is built from their values.

    ``parameters`` and ``build`` may raise ValueError with the reason when the plant has no such controller (no gauge to
    damp with, no wheel line to filter). A family that contains another names it as ``base``; ``extended`` turns the
    values of that one into its own, for the same controller or the nearest that it has. ``final`` builds what is used
    in the end, where that has coarser numbers than what a search wants smooth. Plants and controllers are of one axis
    (`DesignPlant`, `AxisController`) or of all axes (`WholePlant`, `WholeController`).
    """

    name: str
    parameters: Callable[[Any], tuple[Parameter, ...]]
    build: Callable[[Any, Floats], Any]
    base: "Family | None" = None
    extended: Callable[[Any, Floats], Floats] | None = None
    final: Callable[[Any, Floats], Any] | None = None
