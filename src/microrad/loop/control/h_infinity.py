"""H-infinity loop shaping of all axes at once: an integrator on each axis, and the stabilising controller around it.

The plant is shaped by the same weight on each axis, and the shaped plant gets the controller that tolerates the largest
error of its normalised coprime factors (McFarlane and Glover, IEEE Transactions on Automatic Control 37 (1992) 759). A
bilinear map takes the sampled plant to a continuous one and the controller back: norms, poles inside the stability
limit, and the Gramians of the factors are the same on both sides.
"""

import math
from dataclasses import dataclass

import numpy as np

from microrad.core import lti
from microrad.core.arrays import Floats
from microrad.loop.control.analysis import reachable
from microrad.loop.control.lqg import filter_gain, in_own_units, riccati
from microrad.loop.control.problem import Family, Parameter, WholeController, WholePlant

NAME = "H-infinity"

ABOVE_LEAST = 1.1
"""How far above the least norm that can be had the controller is made: at the least itself it has infinite gains."""

_ROOT_2 = math.sqrt(2.0)


@dataclass(frozen=True, slots=True)
class Shape:
    """The weight of each axis: 2 pi crossover / s x (1 + s / (2 pi zero)) / (1 + s / (2 pi roll_off)), in Hz.

    On a mirror that follows at once, ``crossover_hz`` is where the integrator alone would have a gain of 1.
    """

    crossover_hz: float
    zero_hz: float
    roll_off_hz: float


def h_infinity(plant: WholePlant, shape: Shape, *, coarse: bool = False) -> WholeController:
    """The controller of a shaped plant, from all optical errors to all commands.

    Args:
        plant: The plant of all axes.
        shape: The weight of each axis.
        coarse: Whether the matrices are rounded to what processors agree in (`lti.EXACT_BITS`).

    Raises:
        ValueError: For a shape that is not above 0, and where a Riccati equation has no solution.
    """
    for freq_hz in (shape.crossover_hz, shape.zero_hz, shape.roll_off_hz):
        if not freq_hz > 0.0:
            raise ValueError(f"{NAME}: a frequency of {freq_hz:g} Hz shapes no loop: all three have to be above 0")
    weight = _weight(shape, plant.period_s, plant.axes)
    shaped = lti.series(weight, _moved(plant))
    central = _from_continuous(_stabilising(shaped))
    made = lti.series(central, weight)
    gain = abs(plant.gain_rad_v)
    system = lti.StateSpace(made.A, made.B / gain, made.C, made.D / gain)
    system = lti.system_to_bits(system, lti.EXACT_BITS) if coarse else system
    return WholeController(NAME, system, _anti_windup(system, gain))


def _weight(shape: Shape, period_s: float, axes: int) -> lti.StateSpace:
    """The weight of each axis: a sum for the integral, and a first-order low pass behind it."""
    step, keep = 2.0 * math.pi * shape.crossover_hz * period_s, math.exp(-2.0 * math.pi * shape.roll_off_hz * period_s)
    direct = step + shape.crossover_hz / shape.zero_hz
    A = np.array([[1.0, 0.0], [step, keep]])
    B = np.array([[1.0], [direct]])
    C, D = (1.0 - keep) * np.array([[step, keep]]), np.array([[(1.0 - keep) * direct]])
    return lti.StateSpace(*(np.kron(np.eye(axes), matrix) for matrix in (A, B, C, D)))


def _moved(plant: WholePlant) -> lti.StateSpace:
    """What the commands do to the optical errors, in units of the slow gain, without the states they do not reach."""
    own, axes = in_own_units(plant).system, plant.axes
    r = reachable(own.A, own.B[:, :axes])
    seen = own.C[axes:, r] / abs(plant.gain_rad_v)
    return lti.StateSpace(own.A[np.ix_(r, r)], own.B[r, :axes], seen, np.zeros((axes, axes)))


def _stabilising(shaped: lti.StateSpace) -> lti.StateSpace:
    """The continuous controller for the shaped plant, fed back with a plus, `ABOVE_LEAST` times the least norm."""
    n, axes = shaped.order, len(shaped.C)
    one = np.eye(axes)
    X = riccati(shaped.A, shaped.B, shaped.C.T @ shaped.C, one, "the command does not reach an integrator")
    Z = riccati(shaped.A.T, shaped.C.T, shaped.B @ shaped.B.T, one, "the sensors do not see an integrator")
    least = 1.0 + float(np.max(np.linalg.eigvals(X @ Z).real))
    square = ABOVE_LEAST**2 * least
    s = _to_continuous(shaped)
    F = -np.linalg.solve(one + s.D.T @ s.D, s.D.T @ s.C + s.B.T @ X)
    seen = np.asarray(square * np.linalg.solve(((1.0 - square) * np.eye(n) + X @ Z).T, Z @ s.C.T), dtype=float)
    return lti.StateSpace(s.A + s.B @ F + seen @ (s.C + s.D @ F), seen, s.B.T @ X, -s.D.T)


def _to_continuous(s: lti.StateSpace) -> lti.StateSpace:
    """The system at z = (1 + p) / (1 - p), as a function of p."""
    back = np.linalg.inv(s.A + np.eye(s.order))
    return lti.StateSpace(
        back @ (s.A - np.eye(s.order)), _ROOT_2 * back @ s.B, _ROOT_2 * s.C @ back, s.D - s.C @ back @ s.B
    )


def _from_continuous(s: lti.StateSpace) -> lti.StateSpace:
    """The system at p = (z - 1) / (z + 1), as a function of z."""
    back = np.linalg.inv(np.eye(s.order) - s.A)
    return lti.StateSpace(
        back @ (np.eye(s.order) + s.A), _ROOT_2 * back @ s.B, _ROOT_2 * s.C @ back, s.D + s.C @ back @ s.B
    )


def _anti_windup(system: lti.StateSpace, gain: float) -> Floats:
    """L of the controller: an observer of its own states from the commands that are given.

    It takes a given command for one that is off by 1 V, and its readings for such of that size.
    """
    axes = len(system.C)
    noise = np.hstack([gain * system.B, np.zeros((system.order, axes))])
    return filter_gain(system.A, noise, system.C, np.hstack([gain * system.D, np.eye(axes)]))


def _parameters(plant: WholePlant) -> tuple[Parameter, ...]:
    """Crossover, zero and roll-off, by the control rate; the gentlest has the lowest gain at high frequencies."""
    rate = 1.0 / plant.period_s
    return (
        Parameter("crossover", "Hz", 1e-4 * rate, 0.2 * rate, gentle=1e-4 * rate),
        Parameter("zero", "Hz", 3e-3 * rate, 3.0 * rate, gentle=3.0 * rate),
        Parameter("roll-off", "Hz", 3e-3 * rate, 1.0 * rate, gentle=3e-3 * rate),
    )


H_INFINITY_OF_AXES = Family(
    NAME,
    _parameters,
    lambda plant, values: h_infinity(plant, Shape(*(float(v) for v in values))),
    final=lambda plant, values: h_infinity(plant, Shape(*(float(v) for v in values)), coarse=True),
)
"""H-infinity loop shaping of all axes at once, tuned by its weight."""
