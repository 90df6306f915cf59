"""What a loop is handed: the plant, the sampled loop, and their states, as named tuples of arrays."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from microrad.core.kernels.compiler import Count, Floats, Indices, Integers

# Columns of a Bouc-Wen parameter row: Eq. 3 of SPIE 11852, 118523B, then the asymmetry between the signs of h and
# between rising and falling drive, the exponent less 1, and 1 / size of h at which the exponent has no effect.
D1, D2, EPSILON, DELTA, ALPHA, BETA, RATE_LIMIT, BIAS, GAMMA, ETA, POWER, PER_SIZE = range(12)

# Columns of a Prandtl-Ishlinskii operator's row: growth of its thresholds with the rate, and the rate where that ends;
# then the polynomial beside the plays and how far it reaches, see `hysteresis.polynomial`.
WIDENING, WIDENING_LIMIT, QUADRATIC, SIGNED, CUBIC, REACH = range(6)

# Columns of a row of the bank's state, of an actuator's parameters, and of its counters.
Q, H, Z, CHANGE = range(4)
COMMAND_MIN, COMMAND_MAX, RESOLUTION, FOLLOW, SLEW_STEP = range(5)
SATURATED, SLEW_LIMITED = range(2)
BEFORE, NOW = range(2)  # of an actuator's target


class Rows(NamedTuple):
    """A matrix by rows without its zeros: row i is value[start[i]:start[i + 1]] at those columns."""

    start: Indices
    column: Indices
    value: Floats


class Plant(NamedTuple):
    """A linear system in feedback with a bank of hysteresis operators, discretised for a fixed step.

    x[k+1] = Ad x[k] + B0 u[k] + B1 u[k+1] + E0 z[k] + E1 z[k+1],  q = F x + G u,  z = H[q],  y = C x + D u + K z.

    A step predicts x with z held, advances the bank, and corrects x and y for the change of z, so that most of the
    arithmetic does not wait for the bank:

        predicted x = Ad x + B0 u[k] + B1 u[k+1] + (E0 + E1) z[k],     q = F (predicted x) + G u[k+1],
        x[k+1] = predicted x + E1 (change of z),     y = C (predicted x) + D u[k+1] + (C E1) (change of z) + K z[k+1].

    Ad is stored as its diagonal, its coupling of each state with its neighbour (0 with 1, 2 with 3, ...), and the rest
    by rows: a real modal form has no rest, so it costs O(n). Each element has one drive q and one output z: Bouc-Wen
    elements come first, Prandtl-Ishlinskii operators (``operator``) after them, and those of operator i have the plays
    from ``play_start[i]`` to ``play_start[i + 1]``. Without ``feedback`` F is zero, and without ``direct`` B and D are:
    they are not looked at.
    """

    step_s: float
    states: Count
    actuators: Count
    outputs: Count
    elements: Count  # Bouc-Wen only
    operators: Count  # Prandtl-Ishlinskii only
    feedback: bool
    direct: bool
    diagonal: Floats
    coupling: Floats
    rest: Rows
    B0: Floats
    B1: Floats
    E_held: Floats
    E1: Floats
    F: Floats
    G: Floats
    C: Floats
    D: Floats
    CE1: Floats
    K: Floats
    bouc_wen: Floats
    operator: Floats
    play_start: Indices
    play_threshold: Floats
    play_weight: Floats


class PlantState(NamedTuple):
    """The memory of a plant; the kernels write into these arrays. ``clamped`` counts rate-clamped steps by element.

    ``u_next`` is the drive at the end of the step to come and ``y`` the last output. ``bank`` has a row an element:
    drive q, memory h (Bouc-Wen only), output z and its last change; ``play`` holds the states of all plays. ``x`` and
    ``x_next`` have an even length.
    """

    x: Floats
    x_next: Floats
    u: Floats
    u_next: Floats
    y: Floats
    bank: Floats
    play: Floats
    clamped: Integers


class Loop(NamedTuple):
    """Controller, inverse feedforward, converters and amplifier of a sampled loop, as arrays.

    Controller: xc[k+1] = Ac xc + Bc e + L (clip(v) - v),  v = Cc xc + Dc e + feedforward,  e = r - y sampled; L is the
    anti-windup gain. ``actuator`` has a row each: limits of the command, resolution of its converter (0 is ideal),
    FOLLOW of the first-order amplifier, 1 - exp(-2 pi bandwidth step) (1 is ideal), and its slew limit a plant step.
    ``sensor_resolution`` goes by axis; ``allocation`` (actuators, axes) turns references into actuator targets.

    The inverse (`inverse_drive`): ``inverse_bouc_wen`` and ``inverse_play_*`` belong to one actuator each, as do the
    lags of creep, which keep ``inverse_lag_keep`` of themselves over a sample. ``inverse_widening`` (actuators;
    WIDENING in s, WIDENING_LIMIT in output units per second) is the growth of the inverse thresholds with the target's
    rate.
    """

    actuators: Count
    axes: Count
    states: Count
    feedforward: bool
    steps_per_sample: int
    delay_steps: int
    Ac: Floats
    Bc: Floats
    Cc: Floats
    Dc: Floats
    L: Floats
    actuator: Floats
    sensor_resolution: Floats
    allocation: Floats
    inverse_direct: Floats
    inverse_bouc_wen: Floats
    inverse_bouc_wen_actuator: Indices
    inverse_play_threshold: Floats
    inverse_play_weight: Floats
    inverse_play_actuator: Indices
    inverse_widening: Floats
    inverse_lag_keep: Floats
    inverse_lag_weight: Floats
    inverse_lag_actuator: Indices


class LoopState(NamedTuple):
    """The memory of a sampled loop; the kernels write into these arrays.

    ``x`` is xc, ``error`` e, ``output`` v and then what the clip took off it. ``pending`` holds the commands on their
    way through the computation delay, ``position`` its write index. ``counts`` has one row per actuator: saturated
    samples, slew-limited plant steps. ``inverse_clamped`` counts rate-clamped samples of the feedforward's own Bouc-Wen
    elements, then of each actuator's plays; ``x_next`` has no meaning between samples.
    """

    x: Floats
    x_next: Floats
    error: Floats
    output: Floats
    command: Floats
    target: Floats
    inverse_h: Floats
    inverse_p: Floats
    inverse_lag: Floats
    pending: Floats
    position: Integers
    counts: Integers
    inverse_clamped: Integers


def rows(matrix: Floats) -> Rows:
    """A dense matrix as rows without its zeros."""
    places = [np.flatnonzero(row) for row in matrix]
    return Rows(
        start=np.cumsum([0] + [p.size for p in places]).astype(np.uint64),
        column=np.concatenate([*places, np.zeros(0, dtype=np.int64)]).astype(np.uint64),
        value=np.concatenate([*(row[p] for row, p in zip(matrix, places, strict=True)), np.zeros(0)]),
    )


def advanced(plant: Any, matrix: Floats) -> Floats:
    """Ad times a matrix of states.

    Args:
        plant: A `Plant`, or what has its ``diagonal``, its ``coupling`` and no rest.
        matrix: Matrix, shape (states, columns).
    """
    neighbours = matrix[np.arange(len(matrix)) ^ 1]
    product = plant.diagonal[:, None] * matrix + plant.coupling[:, None] * neighbours
    if isinstance(plant, Plant):
        start, column, value = plant.rest
        for i in range(len(matrix)):
            some = slice(int(start[i]), int(start[i + 1]))
            product[i] += value[some] @ matrix[column[some]]
    return np.asarray(product)


def bouc_wen_rows(parameters: Sequence[Sequence[float]]) -> Floats:
    """Parameter rows as an array; a row that ends early (at BIAS or before) is Eq. 3, without what generalises it."""
    rows_array = np.zeros((len(parameters), PER_SIZE + 1))
    for row, values in zip(rows_array, parameters, strict=True):
        row[: len(values)] = values
    return rows_array
