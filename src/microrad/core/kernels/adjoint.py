"""Derivative of the squared error along a path by what enters each of its steps, from the last step to the first."""

from typing import NamedTuple

from microrad.core.kernels.compiler import Floats, compiled_loop


class Adjoint(NamedTuple):
    """Derivatives by what a `PlayPlant` has at each step of its `Path`, one row a step; `adjoint_kernel` fills them.

    ``predicted`` is that by the predicted state (what the drive and z add to it), ``state`` that by the state once z
    has changed, ``q`` and ``z`` those by the drives and the outputs of the operators. The others are working memory:
    what the step behind asks of the state, of z and of each play.
    """

    predicted: Floats
    state: Floats
    q: Floats
    z: Floats
    next_state: Floats
    next_z: Floats
    next_play: Floats


@compiled_loop
def adjoint_kernel(plant, moved, bend, error, adjoint):  # type: ignore[no-untyped-def]
    """Derivatives of half the sum of the squared error, from the last step to the first: the plant's own step turned.

    Args:
        plant: A `PlayPlant`.
        moved: Plays of each operator that its drive carries along, shape (steps, operators), as a `Path` has it.
        bend: Slope of each polynomial, shape (steps, operators).
        error: Error of the output at each step, shape (steps, outputs); zero where none counts.
        adjoint: An `Adjoint` with arrays of as many steps and a working memory of zeros; written.
    """
    next_state, next_z, next_play = adjoint.next_state, adjoint.next_z, adjoint.next_play
    for k in range(error.shape[0] - 1, -1, -1):
        state, predicted, q, z = adjoint.state[k], adjoint.predicted[k], adjoint.q[k], adjoint.z[k]
        for i in range(state.size):
            state[i] = next_state[i]
        for e in range(z.size):
            z[e] = 0.0
        for o in range(error.shape[1]):
            if error[k, o] != 0.0:
                left, through, direct = error[k, o], plant.C[o], plant.K[o]
                for i in range(state.size):
                    state[i] += left * through[i]
                for e in range(z.size):
                    z[e] += left * direct[e]
        for e in range(z.size):
            q[e] = 0.0
        for i in range(state.size):  # q holds what z's change does to the state, until it is that by the drive
            left, pushed = state[i], plant.E1[i]
            for e in range(q.size):
                q[e] += left * pushed[e]
        for i in range(state.size):
            predicted[i] = state[i]
        for e in range(z.size):
            back = q[e]
            total = z[e] + next_z[e] + back
            z[e], next_z[e] = total, -back
            drive, first = bend[k, e] * total, plant.play_start[e]
            for j in range(first, plant.play_start[e + 1]):
                next_play[j] += plant.play_weight[j] * total
            for j in range(first, first + moved[k, e]):
                drive += next_play[j]
                next_play[j] = 0.0
            q[e] = drive
            strain = plant.F[e]
            for i in range(predicted.size):
                predicted[i] += drive * strain[i]
        for i in range(predicted.size):
            left, held = predicted[i], plant.E_held[i]
            for e in range(next_z.size):
                next_z[e] += left * held[e]
        for i in range(0, predicted.size, 2):
            a, b = predicted[i], predicted[i + 1]
            next_state[i] = plant.diagonal[i] * a + plant.coupling[i + 1] * b
            next_state[i + 1] = plant.diagonal[i + 1] * b + plant.coupling[i] * a
