"""H-infinity loop shaping of all axes: the least norm by another way, the norm of the closed loop, integral action."""

import math
import re

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.linalg import solve_discrete_are, solve_discrete_lyapunov

from microrad.core import lti
from microrad.loop.control import h_infinity
from microrad.loop.control.h_infinity import Shape
from microrad.loop.coupled_study import designs, whole
from several_axes import scene_of, three_actuators, two_axes

MIRRORS = {"two actuators": two_axes, "three actuators": three_actuators}
SHAPES = [Shape(20.0, 2000.0, 5000.0), Shape(50.0, 500.0, 2000.0), Shape(100.0, 5000.0, 1000.0)]
every_case = pytest.mark.parametrize("make", MIRRORS.values(), ids=MIRRORS.keys())
every_shape = pytest.mark.parametrize("shape", SHAPES)


def plant_of(make):
    return designs.plants(scene_of(make()))[0]


def response(system, z):
    return np.array([system.C @ np.linalg.solve(p * np.eye(len(system.A)) - system.A, system.B) + system.D for p in z])


def weight_by_hand(shape, period_s, z):
    """A sum for the integral with what goes past it, and a first-order low pass."""
    keep = np.exp(-2 * np.pi * shape.roll_off_hz * period_s)
    integral = 2 * np.pi * shape.crossover_hz * period_s * z / (z - 1.0)
    return (integral + shape.crossover_hz / shape.zero_hz) * (1.0 - keep) * z / (z - keep)


def shaped_by_hand(plant, shape):
    """The plant with its weight as one discrete system: from scaled commands to optical errors in units of the gain."""
    s, axes, T = plant.system, plant.axes, plant.period_s
    keep = math.exp(-2 * math.pi * shape.roll_off_hz * T)
    step, past = 2 * math.pi * shape.crossover_hz * T, shape.crossover_hz / shape.zero_hz
    one = lti.StateSpace(
        np.array([[1.0, 0.0], [step, keep]]),
        np.array([[1.0], [step + past]]),
        (1.0 - keep) * np.array([[step, keep]]),
        (1.0 - keep) * np.array([[step + past]]),
    )
    z = np.exp(2j * np.pi * np.array([0.01, 0.2, 0.4]))
    assert_allclose(response(one, z)[:, 0, 0], weight_by_hand(shape, T, z), rtol=1e-12)
    reach = [s.B[:, :axes]]  # the states that the commands reach, by a basis of what they span
    for _ in range(s.order):
        reach.append(s.A @ reach[-1])
    spans, sizes, _ = np.linalg.svd(np.hstack([each / max(np.abs(each).max(), 1e-300) for each in reach]))
    basis = spans[:, : np.sum(sizes > 1e-9)]
    P = lti.StateSpace(
        basis.T @ s.A @ basis, basis.T @ s.B[:, :axes], s.C[axes:] @ basis / plant.gain_rad_v, np.zeros((axes, axes))
    )
    w = lti.StateSpace(*(np.kron(np.eye(axes), m) for m in (one.A, one.B, one.C, one.D)))
    n, k = len(P.A), len(w.A)
    return lti.StateSpace(
        np.block([[w.A, np.zeros((k, n))], [P.B @ w.C, P.A]]),
        np.vstack([w.B, P.B @ w.D]),
        np.hstack([np.zeros((axes, k)), P.C]),
        np.zeros((axes, axes)),
    )


def least_norm(s):
    """1 / sqrt(1 - Hankel norm^2) of the normalised left coprime factors (Glover and McFarlane 1989, theorem 3.2)."""
    Z = solve_discrete_are(s.A.T, s.C.T, s.B @ s.B.T, np.eye(len(s.C)))
    spread = np.eye(len(s.C)) + s.C @ Z @ s.C.T
    H = -s.A @ Z @ s.C.T @ np.linalg.inv(spread)
    root = np.linalg.inv(np.linalg.cholesky(spread))
    A, B, C = s.A + H @ s.C, np.hstack([s.B, H]), root @ s.C
    reached, seen = solve_discrete_lyapunov(A, B @ B.T), solve_discrete_lyapunov(A.T, C.T @ C)
    return 1.0 / math.sqrt(1.0 - np.max(np.linalg.eigvals(reached @ seen).real))


@pytest.mark.promise("pointing-78", "sampled-loop-13")
@every_case
@every_shape
def test_the_shaped_loop_has_the_norm_that_it_was_made_for(make, shape):
    plant = plant_of(make)
    made, gain = h_infinity.h_infinity(plant, shape), plant.gain_rad_v
    s = shaped_by_hand(plant, shape)
    freq = np.geomspace(1e-2, 0.499 / plant.period_s, 3000)
    z = np.exp(2j * np.pi * freq * plant.period_s)
    G = response(s, z)
    K = response(made.system, z) * gain / weight_by_hand(shape, plant.period_s, z)[:, None, None]
    S = np.linalg.inv(np.eye(2) - G @ K)
    four = np.block([[K @ S, K @ S @ G], [S, S @ G]])
    largest, least = np.max(np.linalg.norm(four, 2, axis=(1, 2))), least_norm(s)
    assert 1.0 < least <= 1.001 * largest  # no controller has less
    assert largest <= h_infinity.ABOVE_LEAST * least * (1.0 + 1e-6)
    whole.whole_margins(plant, made)  # stable


@pytest.mark.promise("pointing-78")
@every_case
def test_it_has_integral_action_and_lets_go_of_the_clip(make):
    plant = plant_of(make)
    made = h_infinity.h_infinity(plant, SHAPES[1])
    poles = np.linalg.eigvals(made.system.A)
    assert np.sum(np.abs(poles - 1.0) < 1e-6) == plant.axes
    assert np.max(np.abs(np.linalg.eigvals(made.system.A - made.anti_windup @ made.system.C))) < 1.0 - 1e-3


def test_rounding_for_processors_leaves_its_response():
    plant = plant_of(two_axes)
    z = np.exp(2j * np.pi * np.geomspace(1e-4, 0.499, 50))
    exact, coarse = (h_infinity.h_infinity(plant, SHAPES[1], coarse=each).system for each in (False, True))
    assert not np.array_equal(exact.A, coarse.A)
    size = np.linalg.norm(response(exact, z), 2, axis=(1, 2))
    assert np.all(np.linalg.norm(response(exact, z) - response(coarse, z), 2, axis=(1, 2)) < 1e-4 * size)


@pytest.mark.parametrize("shape", [Shape(0.0, 500.0, 2000.0), Shape(50.0, -1.0, 2000.0), Shape(50.0, 500.0, math.nan)])
def test_a_shape_that_is_none_is_refused(shape):
    with pytest.raises(ValueError, match=re.escape("all three have to be above 0")):
        h_infinity.h_infinity(plant_of(two_axes), shape)
