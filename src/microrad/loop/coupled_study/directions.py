"""Decoupling by frequency: the two directions of the line of sight that a mirror's modes turn by themselves.

Slow commands are decoupled: one turns its axis alone. Near a resonance each mode turns the beam in its own direction,
and loops along the axes pull on each other there. Loops along the modes' directions are decoupled at rest as well,
whatever directions they have, so that the same commands serve at both frequencies; each loop then has its own mode, and
its own notch or damping for it.
"""

import math
from dataclasses import replace

import numpy as np

from microrad.core import lti
from microrad.core.arrays import Floats
from microrad.loop.control import WholeController, WholePlant
from microrad.loop.control.judge import grid

TELLING = 0.05
"""Least share of the response's size, where the axes pull on each other most, at which other directions are looked for.
Below it the axes are the directions."""

WORTH = 0.5
"""What is left of the largest pull, at most, for directions that are taken."""

STEP_RAD = math.radians(0.1)
"""To what the directions are rounded: a tenth of a degree, far more than processors differ by."""

ALONG_AXES = (0.0, 0.5 * math.pi)
"""Directions of loops along the axes: angles from x towards y."""


def loop_directions(plant: WholePlant) -> tuple[float, float]:
    """The directions of the two loops of a plant: its modes' where its axes pull on each other, else its axes.

    They make the response diagonal where its part across the axes is largest: its eigenvectors there, from its real
    part once the common phase is taken off. Where they leave more than half of the largest pull, over all frequencies,
    the loops go along the axes.

    Args:
        plant: The plant of two axes; slow commands turn their own axis alone.

    Returns the angles from x towards y, in rad above -90 and up to 90 degrees, first the one nearer to x.
    """
    axes, s = plant.axes, plant.system
    from_commands = lti.StateSpace(s.A, s.B[:, :axes], s.C[axes:], np.zeros((axes, axes)))
    response = lti.frequency_response(from_commands, grid(s, plant.period_s), plant.period_s)
    across = np.max(np.abs(response[:, [0, 1], [1, 0]]), axis=1)
    there = response[int(np.argmax(across))]
    left, sizes, right = np.linalg.svd(there)
    if np.max(across) < TELLING * sizes[0]:
        return ALONG_AXES
    phase = np.angle(left[:, 0] @ right[0])
    found, vectors = np.linalg.eig((there * np.exp(-1j * phase)).real)
    if np.iscomplexobj(found):
        return ALONG_AXES
    angles = np.arctan2(vectors[1], vectors[0])
    angles = angles - math.pi * np.ceil((angles - 0.5 * math.pi) / math.pi)
    first, second = sorted((STEP_RAD * np.round(angles / STEP_RAD)).tolist(), key=abs)
    if first == second:
        return ALONG_AXES
    M = towards((first, second))
    left_over = np.linalg.inv(M) @ response @ M
    if np.max(np.abs(left_over[:, [0, 1], [1, 0]])) > WORTH * np.max(across):
        return ALONG_AXES
    return first, second


def towards(directions: tuple[float, float]) -> Floats:
    """Unit vectors of the directions, a column each.

    Args:
        directions: Angles from x towards y (rad).
    """
    return np.array([np.cos(directions), np.sin(directions)])


def along(plant: WholePlant, directions: tuple[float, float]) -> WholePlant:
    """The plant with commands, residuals and readings along other directions than its axes.

    The readings' noise of two directions that are not at right angles is one sequence in part; here each has its own,
    of the same size.

    Args:
        plant: The plant of two axes.
        directions: Angles from x towards y (rad).
    """
    if directions == ALONG_AXES:
        return plant
    s, axes, M = plant.system, plant.axes, towards(directions)
    back = np.linalg.inv(M)
    B, D = s.B.copy(), s.D.copy()
    B[:, :axes] = s.B[:, :axes] @ M
    C = np.kron(np.eye(2), back) @ s.C
    noise = slice(s.B.shape[1] - axes, None)
    D[axes:, noise] = np.diag(np.linalg.norm(back @ s.D[axes:, noise], axis=1))
    return replace(plant, system=lti.StateSpace(s.A, B, C, D))


def on_axes(controller: WholeController, directions: tuple[float, float]) -> WholeController:
    """A controller of loops along other directions as one of the axes.

    Args:
        controller: The controller, from the error along each direction to the command along each.
        directions: Angles from x towards y (rad).
    """
    if directions == ALONG_AXES:
        return controller
    s, M = controller.system, towards(directions)
    back = np.linalg.inv(M)
    system = lti.StateSpace(s.A, s.B @ back, M @ s.C, M @ s.D @ back)
    return replace(controller, system=system, anti_windup=controller.anti_windup @ back)
