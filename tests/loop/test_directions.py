"""Decoupling by frequency: loops along the directions of a mirror's modes."""

import math

import numpy as np
import pytest
from numpy.testing import assert_allclose

from microrad.core import lti
from microrad.loop.control import WholeController, WholePlant
from microrad.loop.coupled_study import directions, whole
from microrad.loop.coupled_study.directions import ALONG_AXES

PERIOD = 1e-4
DEG = math.pi / 180.0


def plant_of(modes, shapes, inputs):
    """Modes (Hz, damping) that turn the beam as the columns of ``shapes`` and are moved as the rows of ``inputs``."""
    n = 2 * len(modes)
    A, B, C = np.zeros((n, n)), np.zeros((n, 2)), np.zeros((2, n))
    for k, (freq_hz, damping) in enumerate(modes):
        w = 2 * np.pi * freq_hz
        A[2 * k : 2 * k + 2, 2 * k : 2 * k + 2] = [[0.0, 1.0], [-w * w, -2 * damping * w]]
        B[2 * k + 1], C[:, 2 * k] = w * w * np.asarray(inputs)[k], np.asarray(shapes)[:, k]
    Ad, Bd = lti.zero_order_hold(A, B, PERIOD)
    noise = np.zeros((n, 2))
    D = np.zeros((4, 4))
    D[2, 2], D[3, 3] = 2e-7, 3e-7
    return WholePlant(PERIOD, lti.StateSpace(Ad, np.hstack([Bd, noise]), np.vstack([-C, -C]), D), 2, 0, 1.0)


def skewed(first, second, modes=((240.0, 0.01), (310.0, 0.01))):
    M = np.array([np.cos([first, second]), np.sin([first, second])])
    return plant_of(modes, M, np.linalg.inv(M))


@pytest.mark.promise("pointing-78")
@pytest.mark.parametrize("angles", [(12.3, -78.9), (40.0, 85.0), (-20.5, 70.0), (-44.0, 60.0)])
def test_modes_of_two_directions_are_found_and_leave_no_pull_at_any_frequency(angles):
    plant = skewed(*(DEG * a for a in angles))
    found = directions.loop_directions(plant)
    assert_allclose(found, [DEG * a for a in sorted(angles, key=abs)], atol=0.5 * directions.STEP_RAD + 1e-12)
    assert all(abs(f / directions.STEP_RAD - round(f / directions.STEP_RAD)) < 1e-9 for f in found)
    turned = directions.along(plant, found)
    response, across = (
        np.abs(
            lti.frequency_response(
                lti.StateSpace(p.system.A, p.system.B[:, :2], p.system.C[2:], np.zeros((2, 2))),
                np.geomspace(1.0, 4900.0, 400),
                PERIOD,
            )[:, [0, 1], [1, 0]]
        ).max()
        for p in (plant, turned)
    )
    assert response > 1.0  # the axes pull on each other
    assert across < 0.01 * response  # by what rounding to a tenth of a degree leaves


@pytest.mark.promise("pointing-78")
def test_axes_that_leave_each_other_alone_stay_the_directions():
    assert directions.loop_directions(skewed(0.0, math.pi / 2)) == ALONG_AXES
    assert directions.loop_directions(skewed(0.02 * DEG, 90.0 * DEG)) == ALONG_AXES


def test_modes_that_are_all_but_one_have_no_directions_of_their_own():
    """What tells them apart is so little that rounding would turn them."""
    alike = ((250.0, 0.01), (250.0 * (1.0 + 1e-6), 0.01))
    assert directions.loop_directions(skewed(30.0 * DEG, -50.0 * DEG, alike)) == ALONG_AXES


def test_directions_that_do_not_help_are_not_taken():
    """Four modes of two pairs of directions: those of one pair leave the other's pull."""
    turn = [np.array([np.cos([a, b]), np.sin([a, b])]) for a, b in ((0.5, 2.0), (-0.5, -2.2))]
    plant = plant_of(
        ((240.0, 0.01), (300.0, 0.01), (250.0, 0.01), (290.0, 0.01)),
        np.hstack(turn),
        0.5 * np.vstack([np.linalg.inv(each) for each in turn]),
    )
    assert directions.loop_directions(plant) == ALONG_AXES


def test_modes_that_only_turn_in_circles_have_no_real_directions():
    """Two modes at one frequency, each of which feeds the other axis with opposite signs: eigenvectors i, -i."""
    circle = np.array([[0.0, 1.0], [-1.0, 0.0]])
    plant = plant_of(((250.0, 0.01), (250.0, 0.01)), np.eye(2), circle)
    assert directions.loop_directions(plant) == ALONG_AXES


def test_a_controller_along_directions_closes_the_same_loop_on_the_axes():
    plant, angles = skewed(20.0 * DEG, -60.0 * DEG), (20.0 * DEG, -60.0 * DEG)
    own = lti.StateSpace(np.eye(2), np.eye(2), np.diag([0.01, 0.02]), np.diag([0.002, 0.001]))
    controller = WholeController("two integrators", own, np.array([[0.1, 0.0], [0.0, 0.3]]))
    turned, back = directions.along(plant, angles), directions.on_axes(controller, angles)
    poles = [
        np.sort_complex(np.linalg.eigvals(whole.closed_map(p, c.system)))
        for p, c in ((turned, controller), (plant, back))
    ]
    assert_allclose(poles[0], poles[1], atol=1e-10)
    M = directions.towards(angles)
    clipped = np.array([0.3, -0.1])  # what the clip takes off the commands of the axes
    assert_allclose(back.anti_windup @ clipped, controller.anti_windup @ np.linalg.solve(M, clipped), atol=1e-15)
    noise = np.linalg.inv(M) @ plant.system.D[2:, 2:]
    assert_allclose(np.diag(turned.system.D[2:, 2:]), np.linalg.norm(noise, axis=1), rtol=1e-12)
    assert directions.along(plant, ALONG_AXES) is plant
    assert directions.on_axes(controller, ALONG_AXES) is controller


def test_a_plant_along_directions_that_are_not_at_right_angles_is_its_own_turned_and_back():
    """Commands, residuals, readings and the size of their noise, each number another one."""
    rng, angles = np.random.default_rng(3), (math.radians(20.0), math.radians(-65.0))
    D = np.zeros((4, 5))
    D[2:, 3:] = [[0.3, 0.0], [0.0, 0.7]]
    s = lti.StateSpace(*(rng.standard_normal(shape) for shape in ((3, 3), (3, 5), (4, 3))), D)
    plant = WholePlant(1e-3, s, 2, 1, 2.0)
    found, M = directions.along(plant, angles), np.array([np.cos(angles), np.sin(angles)])
    back = np.linalg.inv(M)
    assert_allclose(found.system.B, np.column_stack([s.B[:, :2] @ M, s.B[:, 2:]]))
    assert_allclose(found.system.C, np.vstack([back @ s.C[:2], back @ s.C[2:]]), rtol=1e-12)
    assert_allclose(found.system.D[2:, 3:], np.diag(np.hypot(back[:, 0] * 0.3, back[:, 1] * 0.7)), rtol=1e-12)
    assert not found.system.D[:2].any()
    c = lti.StateSpace(*(rng.standard_normal(shape) for shape in ((2, 2), (2, 2), (2, 2), (2, 2))))
    made = directions.on_axes(WholeController("c", c, rng.standard_normal((2, 2))), angles)
    at = np.array([90.0])
    there = lti.frequency_response(c, at, 1e-3)[0]
    assert_allclose(lti.frequency_response(made.system, at, 1e-3)[0], M @ there @ back, rtol=1e-10)
    assert directions.along(plant, directions.ALONG_AXES) is plant
    assert directions.on_axes(made, directions.ALONG_AXES) is made


def test_turning_a_plant_and_a_controller_leaves_them_as_they_are():
    plant = skewed(0.3, -1.2)
    one = lti.StateSpace(np.diag([0.5, 0.2]), np.eye(2), np.array([[1.0, 2.0], [3.0, 4.0]]), 5.0 * np.eye(2))
    controller = WholeController("own", one, np.array([[7.0, 8.0], [9.0, 1.0]]))
    kept = {key: (getattr(plant.system, key).copy(), getattr(one, key).copy()) for key in "ABCD"}
    first, second = (directions.along(plant, (0.3, -1.2)) for _ in range(2))
    turned, again = (directions.on_axes(controller, (0.3, -1.2)) for _ in range(2))
    for key, (of_plant, of_one) in kept.items():
        assert np.array_equal(getattr(plant.system, key), of_plant)
        assert np.array_equal(getattr(one, key), of_one)
        assert np.array_equal(getattr(first.system, key), getattr(second.system, key))
        assert np.array_equal(getattr(turned.system, key), getattr(again.system, key))
    assert controller.anti_windup.tolist() == [[7.0, 8.0], [9.0, 1.0]]
