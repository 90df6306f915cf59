"""LQG: steady Kalman filter of mirror, delays and disturbance, with state feedback, in one discrete controller.

The regulator minimises the variance of the residual plus that of the command's increments; weighting increments, not
the command itself, lets a constant error be driven to 0. The filter is told of two things that the plant does not have:
a slow random walk on the line of sight, which gives integral action, and noise on the command, which buys robustness of
the loop at the command (Doyle and Stein, IEEE Transactions on Automatic Control 24 (1979) 607).
"""

import math
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from microrad.core import kernels, lti
from microrad.core.arrays import Floats
from microrad.loop.control.analysis import reachable
from microrad.loop.control.problem import (
    GAUGE,
    OPTICAL,
    RESIDUAL,
    AxisController,
    DesignPlant,
    Family,
    Parameter,
    WholeController,
    WholePlant,
    once_per_plant,
)

WALK_CORNER = 1e-4
"""Frequency, over the control rate, below which the random walk exceeds the plant's own disturbance and noise."""


REFINED = 2
"""Refinements of the observer's gain."""

OBSERVER_BITS = 24
"""Significant bits (6e-8) of the observer's gain: how it shares an error among like disturbances is left to rounding to
some 1e-11, and a gain beside the optimum costs the square of how far it is off."""


@dataclass(frozen=True, slots=True)
class Weights:
    """What the design trades.

    ``command`` is the cost of an increment of the command against the residual it makes at the slow gain,
    ``sensor_noise`` a factor on both sensors' noise, ``command_noise_v`` the rms of the noise put on the command (V a
    sample), ``walk`` a factor on the random walk (0: none, and no integral action).
    """

    command: float
    sensor_noise: float
    command_noise_v: float
    walk: float = 1.0


def lqg_controller(plant: DesignPlant, weights: Weights, *, coarse: bool = False) -> AxisController:
    """Optimal controller of the plant for these weights; it uses the measurement of its own sample.

    With x the prediction, K the predictor's gain and G the regulator's, v[k] - v[k-1] = -G (A x + K (m - C x), v[k-1]).
    The observer and v[k-1] are driven by the clipped command: anti-windup is their input column.

    Args:
        plant: The plant of one axis.
        weights: What the design trades.
        coarse: Whether the observer's gain and the matrices are rounded to what processors agree in (`OBSERVER_BITS`,
            `lti.EXACT_BITS`).

    Raises:
        ValueError: For a plant without optical sensor, weights that are not above 0, and where a Riccati equation has
            no solution.
    """
    _refuse(plant, weights)
    known, seen_by = _solved(plant), (weights.sensor_noise, weights.command_noise_v, weights.walk)
    if seen_by not in known:
        model = observed(in_own_units(plant), weights)
        known[seen_by] = model, filter_gain(model.A, model.noise, model.seen, model.seen_noise)
    model, K = known[seen_by]
    moved_by = (weights.command, len(model.A))
    if moved_by not in known:
        known[moved_by] = model, regulator_gain(model, weights.command * plant.gain_rad_v**2)
    _, G = known[moved_by]
    system, driven = _controller(model, K, G, inputs=2, coarse=coarse)
    return AxisController("LQG", system, driven)


def _controller(model: "Model", K: Floats, G: Floats, inputs: int, coarse: bool) -> tuple[lti.StateSpace, Floats]:
    """Observer and regulator as one system, and what the given command adds to its states."""
    K = lti.to_bits(K, OBSERVER_BITS) if coarse else K
    (n, commands), sensors = model.command.shape, model.sensors
    driven = np.vstack([model.command, np.eye(commands)])  # observer and last command follow the command that is given
    free = np.zeros((n + commands, n + commands))
    free[:n, :n] = model.A - K @ model.seen
    correction = np.zeros((n + commands, inputs))
    correction[:n, sensors] = K
    last = np.eye(commands, n + commands, n)
    C = last - G @ (free + driven @ last)
    D = -G @ correction
    system = lti.StateSpace(free + driven @ C, correction + driven @ D, C, D)
    return lti.system_to_bits(system, lti.EXACT_BITS) if coarse else system, driven


def lqg_of_axes(plant: WholePlant, weights: Weights, *, coarse: bool = False) -> WholeController:
    """Optimal controller of several axes at once, from all optical errors to all commands.

    As `lqg_controller`, with a random walk on each axis and the same weights for all of them.

    Args:
        plant: The plant of all axes.
        weights: What the design trades.
        coarse: Whether gain and matrices are rounded to what processors agree in.

    Raises:
        ValueError: For weights that are not above 0, and where a Riccati equation has no solution.
    """
    _refuse_weights(weights)
    model = _observed_axes(in_own_units(plant), weights)
    K = filter_gain(model.A, model.noise, model.seen, model.seen_noise)
    G = regulator_gain(model, weights.command * plant.gain_rad_v**2)
    return WholeController(LQG.name, *_controller(model, K, G, plant.axes, coarse))


def _observed_axes(plant: WholePlant, weights: Weights) -> "Model":
    """What a design of several axes knows: the plant with a walk on each axis, and noise on its commands."""
    s, n, axes, several = plant.system, plant.system.order, plant.axes, np.eye(plant.axes)
    corner = np.array([WALK_CORNER / plant.period_s])
    there = lti.frequency_response(s, corner, plant.period_s)[0, :, axes:]
    level = np.linalg.norm(there[axes:], axis=1)
    scale = np.where(np.arange(there.shape[1]) < plant.disturbances, 1.0, weights.sensor_noise)
    A, command = np.eye(n + axes), np.zeros((n + axes, axes))
    A[:n, :n], command[:n] = s.A, s.B[:, :axes]
    noise = np.zeros((n + axes, scale.size + 3 * axes))  # white sequences, on commands, of the walks, of the floors
    noise[:n, : scale.size] = s.B[:, axes:] * scale
    noise[:n, scale.size : scale.size + axes] = s.B[:, :axes] * weights.command_noise_v
    noise[n:, scale.size + axes : scale.size + 2 * axes] = np.diag(2 * math.pi * WALK_CORNER * level * weights.walk)
    seen_noise = np.hstack([s.D[axes:, axes:] * scale, np.zeros((axes, 2 * axes)), np.diag(1e-6 * level)])
    return Model(
        A,
        command,
        np.hstack([s.C[:axes], several]),
        np.hstack([s.C[axes:], several]),
        noise,
        seen_noise,
        list(range(axes)),
        reachable(A, command),
    )


@once_per_plant
def _solved(plant: DesignPlant) -> dict[tuple[float, ...], tuple["Model", Floats]]:
    """Gains that are known, to be added to: observers by what they see, regulators by the weight and the states.

    A search moves one of its three weights at a time, of which either gain needs but one or two.
    """
    del plant
    return {}


@dataclass(frozen=True, slots=True)
class Model:
    """What the design knows: states (plant, walk), and rows and noise of the sensors that it uses.

    ``noise`` and ``seen_noise`` are driven by the same white sequences of unit variance. ``moved`` are the states that
    the command reaches, ``sensors`` the controller's inputs that belong to the rows of ``seen``.
    """

    A: Floats
    command: Floats
    residual: Floats
    seen: Floats
    noise: Floats
    seen_noise: Floats
    sensors: list[int]
    moved: NDArray[np.bool_]


_Plant = TypeVar("_Plant", DesignPlant, WholePlant)


@once_per_plant
def in_own_units(plant: _Plant) -> _Plant:
    """The plant with scaled states, each in a unit of about its own size (a power of 2).

    States in volts beside states in radians cost the Riccati equations eight digits. The size is the rms that some
    thousand samples of the white sequences and of a white command of 1 V build up: a state may drift for ever.
    """
    s = plant.system
    size = np.sqrt(np.diag(lti.gramian(0.999 * s.A.T, s.B @ s.B.T)))
    unit = 2.0 ** np.round(np.log2(np.where(size > 0.0, size, 1.0)))
    scaled = lti.StateSpace(s.A * unit / unit[:, None], s.B / unit[:, None], s.C * unit, s.D)
    return replace(plant, system=scaled)


def observed(plant: DesignPlant, weights: Weights) -> Model:
    """What the design knows of the plant: with walk and noise on the command, and the sensors that it uses.

    Args:
        plant: The plant of one axis.
        weights: Give the size of the walk, of the command's noise and of the sensors' noise.
    """
    s, n = plant.system, plant.system.order
    sensors = [OPTICAL, GAUGE] if plant.has_gauge else [OPTICAL]
    walk, floor = _walk(plant)
    walk *= 0.0 if _has_integrator(plant) else weights.walk
    kept = n + int(walk > 0.0)
    scale = np.where(np.arange(s.B.shape[1] - 1) < plant.disturbances, 1.0, weights.sensor_noise)
    A, command, noise = np.eye(n + 1), np.zeros((n + 1, 1)), np.zeros((n + 1, scale.size + 2))
    A[:n, :n], command[:n] = s.A, s.B[:, :1]
    noise[:n, :-2], noise[:n, -2], noise[n, -1] = s.B[:, 1:] * scale, s.B[:, 0] * weights.command_noise_v, walk
    C = np.hstack([s.C, [[1.0], [1.0], [0.0]]])  # the walk is too slow for the sensor's delay to matter
    return Model(
        A[:kept, :kept],
        command[:kept],
        C[[RESIDUAL], :kept],
        C[sensors, :kept],
        np.hstack([noise[:kept], np.zeros((kept, len(sensors)))]),
        np.hstack([s.D[sensors, 1:] * scale, np.zeros((len(sensors), 2)), floor * np.eye(len(sensors))]),
        [i - OPTICAL for i in sensors],
        reachable(A, command)[:kept],
    )


def _refuse(plant: DesignPlant, weights: Weights) -> None:
    if not plant.has_optical:
        raise ValueError(
            "LQG needs the optical sensor: without it nothing shows the disturbance that the mirror has to follow; "
            "add one, or close the loop on the gauge with another controller"
        )
    _refuse_weights(weights)


def _refuse_weights(weights: Weights) -> None:
    if not (weights.command > 0.0 and weights.sensor_noise > 0.0):
        raise ValueError(
            f"LQG: a command weight of {weights.command:g} and a sensor noise factor of {weights.sensor_noise:g} have "
            "no optimum: both have to be above 0"
        )


@once_per_plant
def _walk(plant: DesignPlant) -> tuple[float, float]:
    """Step of the random walk (rad a sample), and a floor for the sensors' noise (rad), far below either."""
    there = _slow_response(plant)
    level = max(float(np.linalg.norm(there[RESIDUAL])), float(np.linalg.norm(there[OPTICAL])))
    return 2 * math.pi * WALK_CORNER * level, 1e-6 * level


@once_per_plant
def _slow_response(plant: DesignPlant) -> NDArray[np.complex128]:
    """Response from the white sequences to residual and sensors where the walk takes over."""
    corner = np.array([WALK_CORNER / plant.period_s])
    return lti.frequency_response(plant.system, corner, plant.period_s)[0, :, 1:]


@once_per_plant
def _has_integrator(plant: DesignPlant) -> bool:
    """Whether the disturbance itself holds a constant, beside which a walk could not be told apart."""
    own = ~reachable(plant.system.A, plant.system.B[:, :1])
    poles = np.linalg.eigvals(plant.system.A[np.ix_(own, own)])
    return bool(np.any(np.abs(poles - 1.0) < 1e-9))


def filter_gain(A: Floats, noise: Floats, seen: Floats, seen_noise: Floats) -> Floats:
    """Gain K, shape (states, sensors), of the steady one-step predictor x+ = A x + K (m - C x).

    K = (A P C' + N) (C P C' + R)^-1 with P from the Riccati equation, N and R the noise's cross-covariance and the
    sensors' covariance (Anderson and Moore, Optimal Filtering, 1979, section 5.4), then refined: the covariance that K
    leaves is a sum of squares, and hardly depends on the errors of a K near the best (Kleinman, IEEE Transactions on
    Automatic Control 13 (1968) 114).

    Args:
        A: Map of the states, shape (states, states).
        noise: What white sequences of unit variance add to the states, shape (states, sequences).
        seen: C, what the sensors see of the states, shape (sensors, states).
        seen_noise: What the same sequences add to the sensors, shape (sensors, sequences).

    Raises:
        ValueError: The sensors do not see every state that drifts.
    """
    R, N = seen_noise @ seen_noise.T, noise @ seen_noise.T
    whitened = np.linalg.solve(R, N.T)
    P = riccati(
        (A - whitened.T @ seen).T,
        seen.T,
        noise @ noise.T - N @ whitened,
        R,
        "the sensors do not see every state that drifts",
    )
    K = np.linalg.solve(seen @ P @ seen.T + R, seen @ P @ A.T + N.T).T
    for _ in range(REFINED):
        P = _gramian((A - K @ seen).T, (noise - K @ seen_noise) @ (noise - K @ seen_noise).T)
        K = np.linalg.solve(seen @ P @ seen.T + R, seen @ P @ A.T + N.T).T
    return np.asarray(K)


def regulator_gain(model: Model, weight: float) -> Floats:
    """Gain G of v[k] - v[k-1] = -G (A x, v[k-1]), shape (commands, states + commands), that costs least.

    The cost is residual^2 + weight (v[k] - v[k-1])^2, summed over the axes. A Riccati equation is solved where the
    commands reach, and a Stein equation for what they do not: states of the disturbance may be undamped, no pole of
    theirs has to be moved.

    Args:
        model: What the design knows of the plant.
        weight: Cost of the command's increment (rad^2/V^2), above 0.

    Raises:
        ValueError: One of the equations has no solution.
    """
    n, commands = model.command.shape
    m, own = np.append(model.moved, [True] * commands), np.append(~model.moved, [False] * commands)
    A = np.block([[model.A, model.command], [np.zeros((commands, n)), np.eye(commands)]])
    b = np.vstack([model.command, np.eye(commands)])[m]
    c = np.append(model.residual, np.zeros((len(model.residual), commands)), axis=1)
    inside, across, cost = A[np.ix_(m, m)], A[np.ix_(m, own)], weight * np.eye(commands)
    X = riccati(inside, b, c[:, m].T @ c[:, m], cost, "the command does not reach the residual")
    gain = np.linalg.solve(b.T @ X @ b + cost, b.T @ X)
    closed = inside - b @ (gain @ inside)
    Z = stein(closed, A[np.ix_(own, own)], closed.T @ X @ across + c[:, m].T @ c[:, own])
    G = np.zeros((commands, n + commands))
    G[:, m], G[:, own] = gain, np.linalg.solve(b.T @ X @ b + cost, b.T @ Z)
    return G


def riccati(A: Floats, B: Floats, Q: Floats, R: Floats, otherwise: str) -> Floats:
    """Stabilising solution X = A' X (I + B R^-1 B' X)^-1 A + Q of the discrete Riccati equation, shape (n, n).

    Structure-preserving doubling: Chu, Fan, Lin and Wang, International Journal of Control 77 (2004) 767.

    Args:
        A: Map of the states, shape (n, n).
        B: What the inputs add to the states, shape (n, m).
        Q: Cost of the states, shape (n, n), symmetric.
        R: Cost of the inputs, shape (m, m), positive definite.
        otherwise: Reason to give where there is no solution.

    Raises:
        ValueError: The doubling does not settle.
    """
    n = A.shape[0]
    X = np.array(Q, dtype=float)
    power, G = np.array(A, dtype=float), np.ascontiguousarray(B @ np.linalg.solve(R, B.T))
    if kernels.riccati_kernel(power, G, X, np.empty((4, n, n)), np.empty((n, 2 * n))):
        return X
    raise ValueError(f"LQG: the Riccati equation has no stabilising solution: {otherwise}; add damping or a sensor")


def _gramian(A: Floats, Q: Floats) -> Floats:
    """`lti.gramian` for one Q, compiled: a search asks for it a thousand times."""
    X, power = np.array(Q), np.array(A)
    kernels.gramian_kernel(power, X, np.empty((3, *A.shape)))
    return X


def stein(left: Floats, right: Floats, Q: Floats) -> Floats:
    """Solution Z = left' Z right + Q of a Stein equation by doubling, shape (n, m).

    Args:
        left: Shape (n, n), with all its poles inside the unit circle.
        right: Shape (m, m); its poles may lie on the unit circle.
        Q: Shape (n, m).

    Raises:
        ValueError: The largest poles of both have a product of 1 or more.
    """
    slowest = math.prod(float(np.max(np.abs(np.linalg.eigvals(M)), initial=0.0)) for M in (left, right))
    if slowest >= 1.0:
        raise ValueError("LQG: the disturbance grows faster than the loop settles; give its model some damping")
    for _ in range(6 + math.ceil(math.log2(max(1.0, -1.0 / math.log(max(slowest, 1e-3)))))):
        Q = Q + left.T @ Q @ right
        left, right = left @ left, right @ right
    return Q


def _parameters(plant: DesignPlant) -> tuple[Parameter, ...]:
    """Command weight, sensor noise and command noise, the last one around what the optical noise is worth in volts."""
    _refuse(plant, Weights(1.0, 1.0, 0.0))
    sensor = float(np.linalg.norm(_slow_response(plant)[OPTICAL, plant.disturbances :]))
    return _weight_parameters(max(sensor, _walk(plant)[1]) / abs(plant.gain_rad_v))


def _weight_parameters(unit: float) -> tuple[Parameter, ...]:
    """The weights, with the command's noise around a unit in volts."""
    return (
        Parameter("command weight", "", 1e-4, 1e2, gentle=1e2),
        Parameter("sensor noise factor", "", 0.1, 30.0, gentle=30.0),
        Parameter("command noise", "V", 1e-3 * unit, 10.0 * unit),
    )


def _build(plant: DesignPlant, values: Floats) -> AxisController:
    return lqg_controller(plant, Weights(*(float(v) for v in values)))


def _coarse(plant: DesignPlant, values: Floats) -> AxisController:
    return lqg_controller(plant, Weights(*(float(v) for v in values)), coarse=True)


LQG = Family("LQG", _parameters, _build, final=_coarse)
"""Linear-quadratic-Gaussian control, tuned by the weights of `Weights`."""


def _parameters_of_axes(plant: WholePlant) -> tuple[Parameter, ...]:
    """As for one axis: the command's noise around what the optical noise of an axis is worth in volts."""
    corner = np.array([WALK_CORNER / plant.period_s])
    there = np.abs(lti.frequency_response(plant.system, corner, plant.period_s)[0, plant.axes :, plant.axes :])
    noise, level = np.linalg.norm(there[:, plant.disturbances :]), np.linalg.norm(there)
    unit = max(float(noise), 1e-6 * float(level)) / (math.sqrt(plant.axes) * abs(plant.gain_rad_v))
    return _weight_parameters(unit)


LQG_OF_AXES = Family(
    LQG.name,
    _parameters_of_axes,
    lambda plant, values: lqg_of_axes(plant, Weights(*(float(v) for v in values))),
    final=lambda plant, values: lqg_of_axes(plant, Weights(*(float(v) for v in values)), coarse=True),
)
"""LQG of all axes at once."""
