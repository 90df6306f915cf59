"""The part of a linear model between one input and one output: its states, hidden modes, copies of states."""

import math

import numpy as np
from scipy.linalg import matrix_balance

from microrad.core import lti
from microrad.core.arrays import Floats
from microrad.export.records import ExportError
from microrad.loop.control.analysis import reachable

LARGEST = 1e100
"""Numbers beyond it leave the range of a float as soon as they are multiplied."""
HIDDEN = 1e-12
"""A mode that its inputs drive, or its outputs show, by less than this share is not part of the transfer function."""
_COPIED = 1e-15  # of a row's largest entry: the rounding of a factor
_OUTSIDE = 1e-9  # how far |z| of an integrator may lie beyond 1 by rounding


def entry_of(system: lti.StateSpace, output: int, number: int) -> lti.StateSpace:
    """One entry of a linear model: one input to one output, without the states that are not on a way between the two.

    A state is left out if no chain of entries other than 0 joins it to the input, or to the output.

    Args:
        system: The model.
        output: The output's number, from 0.
        number: The input's number, from 0.
    """
    b, c = system.B[:, number : number + 1], system.C[output : output + 1]
    kept = reachable(system.A, b) & reachable(system.A.T, c.T)
    d = system.D[output : output + 1, number : number + 1]
    return lti.StateSpace(system.A[np.ix_(kept, kept)], b[kept], c[:, kept], d)


def without_copies(system: lti.StateSpace) -> lti.StateSpace:
    """The same map without states that are a multiple of another one, a sample after any start, or that nothing reads.

    A chain of delays that is sampled more slowly than it moves has them: samples held several times, or forgotten
    before the next one.
    """
    while True:
        step = np.hstack([system.A, system.B])
        n, at = system.order, np.argmax(np.abs(step), axis=1)
        largest = step[np.arange(n), at]
        unit = step / np.where(largest == 0.0, 1.0, largest)[:, None]
        alike = np.max(np.abs(unit[:, None, :] - unit[None, :, :]), axis=2, initial=0.0) <= _COPIED
        original = np.argmax(alike, axis=1) if n else np.zeros(0, dtype=int)  # the first one that it is like
        gather = np.zeros((n, n))
        gather[np.arange(n), original] = largest / np.where(largest == 0.0, 1.0, largest)[original]
        A, C = system.A @ gather, system.C @ gather
        kept = (original == np.arange(n)) & (np.any(A != 0.0, axis=0) | np.any(C != 0.0, axis=0))
        if np.all(kept):
            return system
        system = lti.StateSpace(A[np.ix_(kept, kept)], system.B[kept], C[:, kept], system.D)


def without_state(system: lti.StateSpace, state: int, equals: Floats) -> lti.StateSpace:
    """The same map without a state that is a combination of the others.

    Args:
        system: The map.
        state: The state's number, from 0.
        equals: The combination, shape (1, states), with a 0 for the state itself.
    """
    kept = np.arange(system.order) != state
    A, C = (M + M[:, state : state + 1] * equals for M in (system.A, system.C))
    return lti.StateSpace(A[np.ix_(kept, kept)], system.B[kept], C[:, kept], system.D)


def refuse_hidden(system: lti.StateSpace, period_s: float, name: str) -> None:
    """Refuse a model in which no input drives a mode or no output shows one, or that has too large a number.

    The test of Popov, Belevitch and Hautus on the balanced system: [A - s, B] and [A - s; C] keep their rank at every
    pole. What loses it has vanished from the transfer function.

    Args:
        system: The model.
        period_s: Its sample time in seconds; 0 where it is continuous.
        name: What messages call it.

    Raises:
        ExportError: With the mode that is hidden, or the number's limit.
    """
    if not all(np.all(np.abs(getattr(system, key)) <= LARGEST) for key in "ABCD"):
        raise ExportError(
            f"{name}: it holds a number that is not finite or beyond {LARGEST:g}; look for nan and infinity in it, "
            "or take other units"
        )
    A, B, C = _balanced(system)
    for pole in np.linalg.eigvals(A):
        away = A - pole * np.eye(system.order)
        sides = ((np.hstack([away, B]), "no input drives"), (np.vstack([away, C]), "no output shows"))
        for values, what in ((np.linalg.svd(side, compute_uv=False), what) for side, what in sides):
            if values[-1] < HIDDEN * values[0]:
                raise ExportError(
                    f"{name}: not minimal, it has a mode that {what}: {pole_text(pole, period_s)}. Zeros, poles and "
                    "coefficients would hide it; take the state space, or a minimal realisation of it (minreal)"
                )


def _balanced(system: lti.StateSpace) -> tuple[Floats, Floats, Floats]:
    """A, B and C with states scaled so that rows and columns of [[A, B], [C, 0]] are of like size."""
    n = system.order
    sizes = np.linalg.norm(system.B, axis=1)[:, None], np.linalg.norm(system.C, axis=0)[None]
    whole = np.block([[system.A, sizes[0]], [sizes[1], np.zeros((1, 1))]])
    scale = matrix_balance(whole, permute=False, separate=True)[1][0]
    states, ends = scale[:n], scale[n]
    return system.A * states / states[:, None], system.B * ends / states[:, None], system.C * states / ends


def refuse_unstable(system: lti.StateSpace, period_s: float, name: str) -> None:
    """Refuse a model with a pole outside the region of stability; integrators pass.

    Args:
        system: The model.
        period_s: Its sample time in seconds; 0 where it is continuous.
        name: What messages call it.

    Raises:
        ExportError: With the worst pole.
    """
    poles = np.linalg.eigvals(system.A)
    beyond = np.abs(poles) - 1.0 if period_s else poles.real / np.maximum(np.abs(poles), 1e-300)
    if not poles.size or np.max(beyond) <= _OUTSIDE:
        return
    raise ExportError(
        f"{name}: unstable, {pole_text(poles[int(np.argmax(beyond))], period_s)}. Coefficients would hide it; take "
        "the state space or zeros and poles, or export a stable model"
    )


def pole_text(pole: complex, period_s: float) -> str:
    """A root in words: its frequency in Hz, and |z| or the damping ratio.

    Args:
        pole: The root, in rad/s where continuous.
        period_s: Sample time in seconds; 0 where continuous.
    """
    if period_s:
        return f"|z| = {abs(pole):.9g} at {abs(np.angle(pole)) / (2.0 * math.pi * period_s):.4g} Hz"
    damping = -pole.real / abs(pole) if pole else 1.0
    return f"{abs(pole) / (2.0 * math.pi):.4g} Hz with a damping ratio of {damping:.4g}"
