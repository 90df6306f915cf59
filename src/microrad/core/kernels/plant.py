"""The mirror: a linear system in feedback with a bank of hysteresis elements, driven by a sampled drive."""

from math import inf
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from microrad.core.kernels.compiler import Floats, Integers, compiled_loop, inlined, merged
from microrad.core.kernels.hysteresis import (
    bouc_wen_advance,
    clamp,
    near_exp,
    play_step,
    polynomial,
    row_product,
    widened,
)
from microrad.core.kernels.records import BIAS, CHANGE, D1, D2, RATE_LIMIT, REACH, WIDENING, WIDENING_LIMIT, H, Q, Z


@inlined
def predict(plant, state):  # type: ignore[no-untyped-def]
    """The part of the predicted x that needs nothing from the end of the step; leaves it in ``x_next``.

    Args:
        plant: The `Plant`.
        state: Its `PlantState` at the begin of the step.
    """
    x, x_next, first_operator = state.x, state.x_next, len(plant.elements)
    for i in range(len(plant.states)):
        total = plant.diagonal[i] * x[i] + plant.coupling[i] * x[i ^ 1]
        if plant.direct:
            for a in range(len(plant.actuators)):
                total += plant.B0[i, a] * state.u[a]
        for e in range(len(plant.elements)):
            total += plant.E_held[i, e] * state.bank[e, Z]
        for o in range(len(plant.operators)):
            total += plant.E_held[i, first_operator + o] * state.bank[first_operator + o, Z]
        x_next[i] = total
    if plant.rest.value.size > 0:
        for i in range(len(plant.states)):
            x_next[i] += row_product(plant.rest, i, x)


@inlined
def _element_drive(plant, state, e):  # type: ignore[no-untyped-def]
    """q of element e at the end of the step, from the predicted x."""
    q = 0.0
    for a in range(len(plant.actuators)):
        q += plant.G[e, a] * state.u_next[a]
    if plant.feedback:
        for i in range(len(plant.states)):
            q += plant.F[e, i] * state.x_next[i]
    return q


@merged
def plant_step(plant, state):  # type: ignore[no-untyped-def]
    """One step to ``u_next``, behind predict: second order, and nothing is iterated.

    Args:
        plant: The `Plant`.
        state: Its `PlantState`, with the drive at the end of the step in ``u_next``; left at the end of the step.
    """
    x, x_next, y, bank, first_operator = state.x, state.x_next, state.y, state.bank, len(plant.elements)
    if plant.direct:
        for i in range(len(plant.states)):
            for a in range(len(plant.actuators)):
                x_next[i] += plant.B1[i, a] * state.u_next[a]
    for i in range(len(plant.outputs)):
        total = 0.0
        for j in range(len(plant.states)):
            total += plant.C[i, j] * x_next[j]
        if plant.direct:
            for a in range(len(plant.actuators)):
                total += plant.D[i, a] * state.u_next[a]
        y[i] = total
    for e in range(len(plant.elements)):
        _finish_element(bank, e, _bouc_wen_element(plant, state, e, _element_drive(plant, state, e)))
    for o in range(len(plant.operators)):
        e = first_operator + o
        _finish_element(bank, e, _play_operator(plant, state, e, o, _element_drive(plant, state, e)))
    for i in range(len(plant.states)):
        total = x_next[i]
        for e in range(len(plant.elements)):
            total += plant.E1[i, e] * bank[e, CHANGE]
        for o in range(len(plant.operators)):
            total += plant.E1[i, first_operator + o] * bank[first_operator + o, CHANGE]
        x[i] = total
    for i in range(len(plant.outputs)):
        for e in range(len(plant.elements)):
            y[i] += plant.CE1[i, e] * bank[e, CHANGE] + plant.K[i, e] * bank[e, Z]
        for o in range(len(plant.operators)):
            e = first_operator + o
            y[i] += plant.CE1[i, e] * bank[e, CHANGE] + plant.K[i, e] * bank[e, Z]
    for a in range(len(plant.actuators)):
        state.u[a] = state.u_next[a]


@inlined
def _finish_element(bank, e, z):  # type: ignore[no-untyped-def]
    bank[e, CHANGE] = z - bank[e, Z]
    bank[e, Z] = z


@inlined
def _bouc_wen_element(plant, state, e, q):  # type: ignore[no-untyped-def]
    """z of Bouc-Wen element e, advanced exactly from its stored q to ``q``."""
    row = plant.bouc_wen
    travel = q - state.bank[e, Q]
    rate = travel / plant.step_s
    if abs(rate) > row[e, RATE_LIMIT]:
        state.clamped[e] += 1
        rate = clamp(rate, row[e, RATE_LIMIT])
    h = bouc_wen_advance(state.bank[e, H], travel, rate, row, e)
    state.bank[e, H] = h
    state.bank[e, Q] = q
    return row[e, D1] * (near_exp(-row[e, D2] * rate) * (q + row[e, BIAS]) - row[e, BIAS]) + h


@inlined
def _play_operator(plant, state, e, o, q):  # type: ignore[no-untyped-def]
    """z of Prandtl-Ishlinskii operator o, which is element e, with its plays taken to the drive ``q``."""
    widening = 0.0
    if plant.operator[o, WIDENING] != 0.0:
        rate = abs(q - state.bank[e, Q]) / plant.step_s
        if rate > plant.operator[o, WIDENING_LIMIT]:
            state.clamped[e] += 1
            rate = plant.operator[o, WIDENING_LIMIT]
        widening = plant.operator[o, WIDENING] * rate
    total = 0.0
    for j in range(plant.play_start[o], plant.play_start[o + 1]):
        p = play_step(state.play[j], q, widened(plant.play_threshold[j], widening))
        state.play[j] = p
        total += plant.play_weight[j] * p
    if plant.operator[o, REACH] < inf:
        total += polynomial(plant.operator, o, q)
    state.bank[e, Q] = q
    return total


@compiled_loop
def open_loop(plant, state, drive, output, bank):  # type: ignore[no-untyped-def]
    """Response of the mirror to a drive that is linear between samples spaced by the plant's step.

    Leaves ``state`` at the last sample, so that a following call continues. The first sample is reached from the stored
    state in one step.

    Args:
        plant: The `Plant`.
        state: Its `PlantState`.
        drive: Drive about the bias, V, shape (samples, actuators).
        output: Outputs about those at rest, shape (samples, outputs); written.
        bank: Outputs z of the hysteresis elements, shape (samples, elements), or of the first few; written.
    """
    for k in range(drive.shape[0]):
        for a in range(len(plant.actuators)):
            state.u_next[a] = drive[k, a]
        predict(plant, state)
        plant_step(plant, state)
        for i in range(len(plant.outputs)):
            output[k, i] = state.y[i]
        for i in range(bank.shape[1]):
            bank[k, i] = state.bank[i, Z]


class Columns(NamedTuple):
    """A `Plant` for many states: the matrices of `Ensemble`, column by column, flat, so that a loop runs down each.

    The inputs are z by element and u by actuator, the sums q by element and y by output. All have zeros behind them, to
    a multiple of four. ``held`` turns the inputs at the begin of a step into states, ``seen`` states into sums,
    ``drives`` adds z of the begin and u of the end to q, and ``outputs`` z and u of the end to y. ``states``,
    ``inputs`` and ``sums`` are memory for a step.
    """

    held: Floats
    seen: Floats
    drives: Floats
    outputs: Floats
    states: Floats
    inputs: Floats
    sums: Floats


@merged
def _add_columns(total, gains, columns):  # type: ignore[no-untyped-def]
    """total += sum of gains[j] x column j, four at a time; a number of columns that four divides, one behind the other.

    Unsigned places in a flat array, so that the loop has no test for a negative one: half of the time otherwise.
    """
    length, at = np.uint64(total.size), np.uint64(0)
    for j in range(0, gains.size, 4):
        a, b, c, d = gains[j], gains[j + 1], gains[j + 2], gains[j + 3]
        second, third, fourth = at + length, at + np.uint64(2) * length, at + np.uint64(3) * length
        for i in range(length):
            begun = a * columns[at + i] + b * columns[second + i]
            total[i] += begun + (c * columns[third + i] + d * columns[fourth + i])
        at = fourth + length


@compiled_loop
def open_loop_by_columns(plant, columns, state, drive, output, bank):  # type: ignore[no-untyped-def]
    """`open_loop` for many states: its x is that of `Ensemble`, so a state goes on in this function alone.

    Args:
        plant: The `Plant`.
        columns: Its `Columns`.
        state: Its `PlantState`.
        drive: Drive about the bias, V, shape (samples, actuators).
        output: Outputs about those at rest, shape (samples, outputs); written.
        bank: Outputs z of the hysteresis elements, shape (samples, elements), or of the first few; written.
    """
    x, moved, z, sums = columns.states, state.x_next, columns.inputs, columns.sums
    first_operator, elements, actuators = len(plant.elements), state.bank.shape[0], state.u.size
    u, y = z[elements:], sums[elements:]
    for i in range(moved.size):
        x[i] = state.x[i]
    for e in range(elements):
        z[e] = state.bank[e, Z]
    for a in range(actuators):
        u[a] = state.u[a]
    for k in range(drive.shape[0]):
        for i in range(0, moved.size, 2):
            moved[i] = plant.diagonal[i] * x[i] + plant.coupling[i] * x[i + 1]
            moved[i + 1] = plant.diagonal[i + 1] * x[i + 1] + plant.coupling[i + 1] * x[i]
        if plant.rest.value.size > 0:
            for i in range(moved.size):
                moved[i] += row_product(plant.rest, i, x)
        for i in range(moved.size):
            x[i] = moved[i]
        _add_columns(x, z, columns.held)
        for a in range(actuators):
            u[a] = drive[k, a]
        for i in range(sums.size):
            sums[i] = 0.0
        _add_columns(sums, x, columns.seen)
        _add_columns(sums, z, columns.drives)
        for e in range(first_operator):
            z[e] = _bouc_wen_element(plant, state, e, sums[e])
        for o in range(len(plant.operators)):
            e = first_operator + o
            z[e] = _play_operator(plant, state, e, o, sums[e])
        _add_columns(sums, z, columns.outputs)
        for i in range(state.y.size):
            output[k, i] = y[i]
        for e in range(bank.shape[1]):
            bank[k, e] = z[e]
    for i in range(moved.size):
        state.x[i] = x[i]
    for e in range(elements):
        state.bank[e, Z] = z[e]
    for a in range(actuators):
        state.u[a] = u[a]
    for i in range(state.y.size):
        state.y[i] = y[i]


class PlayPlant(NamedTuple):
    """The arrays of a `Plant` with Prandtl-Ishlinskii operators only and an Ad without rest.

    The thresholds of each operator ascend and do not depend on the rate.

    Without the counts, for a search: it compiles once for all sizes, where a `Plant` compiles for each.
    """

    diagonal: NDArray[Any]
    coupling: NDArray[Any]
    B0: NDArray[Any]
    B1: NDArray[Any]
    E_held: NDArray[Any]
    E1: NDArray[Any]
    F: NDArray[Any]
    G: NDArray[Any]
    C: NDArray[Any]
    D: NDArray[Any]
    K: NDArray[Any]
    operator: NDArray[Any]
    play_start: Integers
    play_threshold: NDArray[Any]
    play_weight: NDArray[Any]


class Path(NamedTuple):
    """What a `PlayPlant` went through, one row a step: `play_path` fills it, `tangent_kernel` runs along it.

    ``x`` is the predicted state (see `Plant`), ``state`` the one with the change of z in it; ``q``, ``z`` and ``play``
    are the drives, the outputs and the plays of the operators. ``moved`` counts for each operator the plays that its
    drive carries along: always the first ones, for the memories of an operator that began at rest are nested.
    """

    output: Floats
    x: Floats
    state: Floats
    q: Floats
    z: Floats
    play: Floats
    moved: Integers


@inlined
def _weigh(total, gains, columns):  # type: ignore[no-untyped-def]
    """total += sum of gains[j] x columns[j]: a column at a time, which is vectorised where a sum over a row is not."""
    for j in range(gains.size):
        gain, column = gains[j], columns[j]
        for i in range(total.size):
            total[i] += gain * column[i]


@inlined
def _path_operator(plant, path, e, k):  # type: ignore[no-untyped-def]
    """z of operator e at step k, and how many of its plays its drive carries along."""
    q, total, count = path.q[k, e], 0.0, 0
    for j in range(plant.play_start[e], plant.play_start[e + 1]):
        threshold = plant.play_threshold[j]
        p = play_step(path.play[k - 1, j] if k > 0 else 0.0, q, threshold)
        path.play[k, j] = p
        total += plant.play_weight[j] * p
        if p == q - threshold or p == q + threshold:
            count += 1
    if plant.operator[e, REACH] < inf:
        total += polynomial(plant.operator, e, q)
    path.z[k, e] = total
    path.moved[k, e] = count


@compiled_loop
def play_path(plant, columns, drive, change, path):  # type: ignore[no-untyped-def]
    """`open_loop` from rest with the whole path kept; the same arithmetic, see `Plant`, in loops of any length.

    Args:
        plant: A `PlayPlant`.
        columns: The same with each matrix turned: a row for each of its columns.
        drive: Drive about the bias, V, shape (steps, inputs).
        change: Memory for the change of z, shape (operators,).
        path: A `Path` with arrays of as many steps; written.
    """
    for k in range(drive.shape[0]):
        u, x, state, q, z, output = drive[k], path.x[k], path.state[k], path.q[k], path.z[k], path.output[k]
        for i in range(x.size):
            x[i] = 0.0
        _weigh(x, u, columns.B1)
        if k > 0:
            before = path.state[k - 1]
            for i in range(0, x.size, 2):
                x[i] += plant.diagonal[i] * before[i] + plant.coupling[i] * before[i + 1]
                x[i + 1] += plant.diagonal[i + 1] * before[i + 1] + plant.coupling[i + 1] * before[i]
            _weigh(x, drive[k - 1], columns.B0)
            _weigh(x, path.z[k - 1], columns.E_held)
        for e in range(q.size):
            q[e] = 0.0
        _weigh(q, u, columns.G)
        _weigh(q, x, columns.F)
        for e in range(q.size):
            _path_operator(plant, path, e, k)
            change[e] = z[e] - (path.z[k - 1, e] if k > 0 else 0.0)
        for i in range(x.size):
            state[i] = x[i]
        _weigh(state, change, columns.E1)
        for o in range(output.size):
            output[o] = 0.0
        _weigh(output, state, columns.C)
        _weigh(output, u, columns.D)
        _weigh(output, z, columns.K)
