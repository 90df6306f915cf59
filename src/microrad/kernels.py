"""The compiled loops: hysteresis, mirror and sampled closed loop, advanced sample by sample.

Arrays, floats and named tuples in, arrays out; no checks, no units, no input or output. This is the only file that
imports numba, and it stays one file: the machine-code cache of one file does not see an edit in another.
Every kernel has a slow, obvious twin in ``tests/oracles.py`` and runs unchanged under ``NUMBA_DISABLE_JIT=1``.

All quantities are deviations from the operating point (drive bias, output at rest), so zero states are at rest.
"""

from collections.abc import Callable
from math import exp, log1p
from typing import Any, NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Indices = NDArray[np.uint64]  # unsigned: no test for a negative index in the innermost loop

# No run-time reference counts (an option numba keeps under an underscore): they cost ten times the arithmetic, and the
# loops allocate nothing. Contraction is the fused multiply-add that a C compiler uses by default; unlike fast-math
# it keeps nan and inf. Measured on the closed loop: 1600 ns a step with counts, 65 without.
_OPTIONS: dict[str, Any] = {
    "cache": True,
    "nogil": True,
    "error_model": "numpy",
    "fastmath": {"contract"},
    "_nrt": False,
}
_compile: Callable[[Any], Any] = numba.njit(**_OPTIONS)
_inline: Callable[[Any], Any] = numba.njit(inline="always", **_OPTIONS)

# Columns of a Bouc-Wen parameter row (Eq. 3 of SPIE 11852, 118523B).
D1, D2, EPSILON, DELTA, ALPHA, BETA, RATE_LIMIT, BIAS = range(8)

# Columns of a row of the bank's state, of an actuator's parameters, and of its counters.
Q, H, Z, CHANGE = range(4)
COMMAND_MIN, COMMAND_MAX, RESOLUTION, FOLLOW, SLEW_STEP = range(5)
SATURATED, SLEW_LIMITED = range(2)
BEFORE, NOW = range(2)  # of an actuator's target


# A tuple whose length is a count: the length is part of the compiled type, so that short loops over it are unrolled.
# (Their overhead took half the time of a one-axis step.) Its items mean nothing. A new set of counts compiles once.
Count = tuple[int, ...]


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
    by rows: a real modal form has no rest, so it costs O(n). Bouc-Wen elements come first in q and z, play operators
    after them. Without ``feedback`` F is zero, and without ``direct`` B and D are: they are not looked at.
    """

    step_s: float
    states: Count
    actuators: Count
    outputs: Count
    elements: Count  # Bouc-Wen only
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
    play_threshold: Floats
    play_weight: Floats


class PlantState(NamedTuple):
    """The memory of a plant; the kernels write into these arrays. ``clamped`` counts rate-clamped steps by element.

    ``u_next`` is the drive at the end of the step to come and ``y`` the last output. ``bank`` has a row an element:
    drive q, memory (h, or a play operator's state), output z and its last change. ``x`` and ``x_next`` have an even
    length.
    """

    x: Floats
    x_next: Floats
    u: Floats
    u_next: Floats
    y: Floats
    bank: Floats
    clamped: Integers


class Loop(NamedTuple):
    """Controller, inverse feedforward, converters and amplifier of a sampled loop, as arrays.

    Controller: xc[k+1] = Ac xc + Bc e + L (clip(v) - v),  v = Cc xc + Dc e + feedforward,  e = r - y sampled; L is the
    anti-windup gain. ``actuator`` has a row each: limits of the command, resolution of its converter (0 is ideal),
    FOLLOW of the first-order amplifier, 1 - exp(-2 pi bandwidth step) (1 is ideal), and its slew limit a plant step.
    ``sensor_resolution`` goes by axis; ``allocation`` (actuators, axes) turns references into actuator targets.
    """

    actuators: Count
    axes: Count
    states: Count
    inverse_elements: Count  # Bouc-Wen only
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


class LoopState(NamedTuple):
    """The memory of a sampled loop; the kernels write into these arrays.

    ``x`` is xc, ``error`` e, ``output`` v and then what the clip took off it. ``pending`` holds the commands on their
    way through the computation delay, ``position`` its write index. ``counts`` has one row per actuator: saturated
    samples, slew-limited plant steps. ``inverse_clamped`` counts rate-clamped samples of the feedforward's own
    elements; ``x_next`` has no meaning between samples.
    """

    x: Floats
    x_next: Floats
    error: Floats
    output: Floats
    command: Floats
    target: Floats
    inverse_h: Floats
    inverse_p: Floats
    pending: Floats
    position: Integers
    counts: Integers
    inverse_clamped: Integers


@_inline
def _near_exp(x):  # type: ignore[no-untyped-def]
    """exp(x), near 0 by its Taylor series to rounding error: a call would cost more than the rest of the element."""
    if abs(x) < 0.002:
        return 1.0 + x * (1.0 + x * (1.0 / 2.0 + x * (1.0 / 6.0 + x * (1.0 / 24.0))))
    if abs(x) < 0.25:
        x2 = x * x
        x4 = x2 * x2
        low = (1.0 + x) + x2 * (1.0 / 2.0 + x * (1.0 / 6.0))
        middle = (1.0 / 24.0 + x * (1.0 / 120.0)) + x2 * (1.0 / 720.0 + x * (1.0 / 5040.0))
        high = (1.0 / 40320.0 + x * (1.0 / 362880.0)) + x2 * (1.0 / 3628800.0 + x * (1.0 / 39916800.0))
        return low + x4 * (middle + x4 * high)
    return exp(x)


@_inline
def _relaxed(h, forcing, decay):  # type: ignore[no-untyped-def]
    """h after unit time of h' = forcing - decay h, that is h + (forcing - decay h) (1 - exp(-decay)) / decay.

    The last factor is its Taylor series where the difference would cancel: 8 terms, 1e-16 at 0.05 (expm1 costs twice).
    """
    if abs(decay) < 0.05:
        d, d2 = decay, decay * decay
        low = (1.0 - d * (1.0 / 2.0)) + d2 * (1.0 / 6.0 - d * (1.0 / 24.0))
        high = (1.0 / 120.0 - d * (1.0 / 720.0)) + d2 * (1.0 / 5040.0 - d * (1.0 / 40320.0))
        return h + (forcing - decay * h) * (low + d2 * d2 * high)
    return h + (forcing - decay * h) * (1.0 - exp(-decay)) / decay


@_inline
def bouc_wen_step(h, travel, epsilon_rate, alpha, beta):  # type: ignore[no-untyped-def]
    """Exact h after a drive that moves by ``travel`` at constant rate; ``epsilon_rate`` = epsilon exp(delta |rate|).

    h' = epsilon_rate q' - beta q' |h| - alpha |q'| h  is linear in h on each side of zero, with forcing F and decay k:
    h <- h exp(-k) + F (1 - exp(-k)) / k. It crosses zero at most once, at the fraction ln(1 - k h / F) / k of the step.
    """
    forcing = epsilon_rate * travel
    side = 1.0 if h > 0.0 or (h == 0.0 and forcing > 0.0) else -1.0
    decay = alpha * abs(travel) + side * beta * travel
    end = _relaxed(h, forcing, decay)
    if h * forcing >= 0.0 or h * end > 0.0:
        return end
    # The sign changes inside the step: reach zero, then leave it on the other side with that side's decay.
    fraction = -h / forcing if decay == 0.0 else log1p(-decay * h / forcing) / decay
    rest = max(0.0, 1.0 - fraction)
    other = alpha * abs(travel) - side * beta * travel
    return _relaxed(0.0, forcing * rest, other * rest)


@_inline
def _clamp(value, limit):  # type: ignore[no-untyped-def]
    return limit if value > limit else (-limit if value < -limit else value)


@_inline
def _play(p, q, threshold):  # type: ignore[no-untyped-def]
    return max(q - threshold, min(q + threshold, p))


@_inline
def _row(matrix, i, w):  # type: ignore[no-untyped-def]
    """Row i of the matrix times the vector w."""
    total = 0.0
    for j in range(matrix.start[i], matrix.start[i + 1]):
        total += matrix.value[j] * w[matrix.column[j]]
    return total


@_compile
def bouc_wen_kernel(drive, step_s, parameters, hysteresis0, output, hysteresis):  # type: ignore[no-untyped-def]
    """Static Eq. 3 for a sampled drive, linear between samples; fills ``output`` and ``hysteresis``.

    Returns the number of rate-clamped samples. The rate is the backward difference, zero at the first sample.
    """
    h = hysteresis0
    clamped = 0
    previous = drive[0]
    for k in range(drive.size):
        travel = drive[k] - previous
        rate = travel / step_s
        if abs(rate) > parameters[RATE_LIMIT]:
            clamped += 1
            rate = _clamp(rate, parameters[RATE_LIMIT])
        h = bouc_wen_step(
            h,
            travel,
            parameters[EPSILON] * _near_exp(parameters[DELTA] * abs(rate)),
            parameters[ALPHA],
            parameters[BETA],
        )
        linear = parameters[D1] * _near_exp(-parameters[D2] * rate) * (drive[k] + parameters[BIAS])
        output[k] = linear - parameters[D1] * parameters[BIAS] + h
        hysteresis[k] = h
        previous = drive[k]
    return clamped


def bouc_wen_response(
    drive: Floats, step_s: float, parameters: Floats, hysteresis0: float
) -> tuple[Floats, Floats, int]:
    """Static Eq. 3 for a sampled drive: (output, hysteresis, number of rate-clamped samples), see bouc_wen_kernel."""
    output, hysteresis = np.empty(drive.size), np.empty(drive.size)
    clamped = bouc_wen_kernel(drive, step_s, parameters, hysteresis0, output, hysteresis)
    return output, hysteresis, int(clamped)


@_compile
def play_kernel(drive, thresholds, state0, states):  # type: ignore[no-untyped-def]
    """States of play operators, p <- max(u - r, min(u + r, p)); fills ``states`` (samples, operators)."""
    for j in range(thresholds.size):
        p = state0[j]
        for k in range(drive.size):
            p = _play(p, drive[k], thresholds[j])
            states[k, j] = p


def play_response(drive: Floats, thresholds: Floats, state0: Floats) -> Floats:
    """States of play operators, shape (samples, operators), see play_kernel."""
    states = np.empty((drive.size, thresholds.size))
    play_kernel(drive, thresholds, state0, states)
    return states


@_inline
def _predict(plant, state):  # type: ignore[no-untyped-def]
    """The part of the predicted x that needs nothing from the end of the step."""
    x, x_next, first_play = state.x, state.x_next, len(plant.elements)
    for i in range(len(plant.states)):
        total = plant.diagonal[i] * x[i] + plant.coupling[i] * x[i ^ 1]
        if plant.direct:
            for a in range(len(plant.actuators)):
                total += plant.B0[i, a] * state.u[a]
        for e in range(len(plant.elements)):
            total += plant.E_held[i, e] * state.bank[e, Z]
        x_next[i] = total
    for e in range(first_play, state.bank.shape[0]):
        for i in range(len(plant.states)):
            x_next[i] += plant.E_held[i, e] * state.bank[e, Z]
    if plant.rest.value.size > 0:
        for i in range(len(plant.states)):
            x_next[i] += _row(plant.rest, i, x)


@_inline
def _element_drive(plant, state, e):  # type: ignore[no-untyped-def]
    """q of element e at the end of the step, from the predicted x."""
    q = 0.0
    for a in range(len(plant.actuators)):
        q += plant.G[e, a] * state.u_next[a]
    if plant.feedback:
        for i in range(len(plant.states)):
            q += plant.F[e, i] * state.x_next[i]
    return q


@_inline
def _plant_step(plant, state):  # type: ignore[no-untyped-def]
    """One step to ``u_next``, behind _predict: second order, and nothing is iterated."""
    x, x_next, y, bank, first_play = state.x, state.x_next, state.y, state.bank, len(plant.elements)
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
    for e in range(first_play, bank.shape[0]):
        q = _element_drive(plant, state, e)
        p = _play(bank[e, H], q, plant.play_threshold[e - first_play])
        bank[e, H] = p
        bank[e, Q] = q
        _finish_element(bank, e, plant.play_weight[e - first_play] * p)
    for i in range(len(plant.states)):
        total = x_next[i]
        for e in range(len(plant.elements)):
            total += plant.E1[i, e] * bank[e, CHANGE]
        x[i] = total
    for i in range(len(plant.outputs)):
        for e in range(len(plant.elements)):
            y[i] += plant.CE1[i, e] * bank[e, CHANGE] + plant.K[i, e] * bank[e, Z]
    for e in range(first_play, bank.shape[0]):
        for i in range(len(plant.states)):
            x[i] += plant.E1[i, e] * bank[e, CHANGE]
        for i in range(len(plant.outputs)):
            y[i] += plant.CE1[i, e] * bank[e, CHANGE] + plant.K[i, e] * bank[e, Z]
    for a in range(len(plant.actuators)):
        state.u[a] = state.u_next[a]


@_inline
def _finish_element(bank, e, z):  # type: ignore[no-untyped-def]
    bank[e, CHANGE] = z - bank[e, Z]
    bank[e, Z] = z


@_inline
def _bouc_wen_element(plant, state, e, q):  # type: ignore[no-untyped-def]
    """z of Bouc-Wen element e, advanced exactly from its stored q to ``q``."""
    row = plant.bouc_wen
    travel = q - state.bank[e, Q]
    rate = travel / plant.step_s
    if abs(rate) > row[e, RATE_LIMIT]:
        state.clamped[e] += 1
        rate = _clamp(rate, row[e, RATE_LIMIT])
    grown = row[e, EPSILON] * _near_exp(row[e, DELTA] * abs(rate))
    h = bouc_wen_step(state.bank[e, H], travel, grown, row[e, ALPHA], row[e, BETA])
    state.bank[e, H] = h
    state.bank[e, Q] = q
    return row[e, D1] * (_near_exp(-row[e, D2] * rate) * (q + row[e, BIAS]) - row[e, BIAS]) + h


@_compile
def open_loop(plant, state, drive, output, bank):  # type: ignore[no-untyped-def]
    """Response of the mirror to ``drive`` (samples, actuators), linear between samples spaced by the plant's step.

    Fills ``output`` (samples, outputs) and ``bank`` (samples, elements; z) and leaves ``state`` at the last sample,
    so that a following call continues. The first sample is reached from the stored state in one step.
    """
    for k in range(drive.shape[0]):
        for a in range(len(plant.actuators)):
            state.u_next[a] = drive[k, a]
        _predict(plant, state)
        _plant_step(plant, state)
        for i in range(len(plant.outputs)):
            output[k, i] = state.y[i]
        for i in range(bank.shape[1]):
            bank[k, i] = state.bank[i, Z]


@_compile
def _inverse(loop, state, reference, sample_s, feedforward):  # type: ignore[no-untyped-def]
    """Causal inverse-multiplicative feedforward (Eq. 4), and the closed-form inverse of play operators.

    u = (r - h + d1 bias) / (d1 exp(-d2 q')) - bias, with h and q' driven by the reference, q = r / d1: taking the rate
    from the feedforward's own last sample makes it chatter at the sample rate. It needs nothing from the loop, so it
    runs ahead of it, over all of ``reference``, into ``feedforward`` (samples, actuators).
    """
    for k in range(reference.shape[0]):
        for a in range(len(loop.actuators)):
            target = 0.0
            for i in range(len(loop.axes)):
                target += loop.allocation[a, i] * reference[k, i]
            state.target[a, BEFORE] = state.target[a, NOW]
            state.target[a, NOW] = target
            feedforward[k, a] = loop.inverse_direct[a] * target
        for e in range(len(loop.inverse_elements)):
            row, a = loop.inverse_bouc_wen, loop.inverse_bouc_wen_actuator[e]
            travel = (state.target[a, NOW] - state.target[a, BEFORE]) / row[e, D1]
            rate = travel / sample_s
            if abs(rate) > row[e, RATE_LIMIT]:
                state.inverse_clamped[e] += 1
                rate = _clamp(rate, row[e, RATE_LIMIT])
            grown = row[e, EPSILON] * _near_exp(row[e, DELTA] * abs(rate))
            h = bouc_wen_step(state.inverse_h[e], travel, grown, row[e, ALPHA], row[e, BETA])
            state.inverse_h[e] = h
            gain = row[e, D1] * _near_exp(-row[e, D2] * rate)
            feedforward[k, a] += (state.target[a, NOW] - h + row[e, D1] * row[e, BIAS]) / gain - row[e, BIAS]
        for e in range(loop.inverse_play_actuator.size):
            a = loop.inverse_play_actuator[e]
            p = _play(state.inverse_p[e], state.target[a, NOW], loop.inverse_play_threshold[e])
            state.inverse_p[e] = p
            feedforward[k, a] += loop.inverse_play_weight[e] * p


@_inline
def _quantised(value, resolution):  # type: ignore[no-untyped-def]
    return np.floor(value / resolution + 0.5) * resolution if resolution > 0.0 else value


@_inline
def _control_sample(loop, state, reference, feedforward, k, y):  # type: ignore[no-untyped-def]
    """One sample of the controller: error, output, clip with anti-windup, converter."""
    for a in range(len(loop.actuators)):
        total = feedforward[k, a]
        for j in range(len(loop.states)):
            total += loop.Cc[a, j] * state.x[j]
        state.output[a] = total
    for i in range(len(loop.states)):
        total = 0.0
        for j in range(len(loop.states)):
            total += loop.Ac[i, j] * state.x[j]
        state.x_next[i] = total
    for i in range(len(loop.axes)):
        state.error[i] = reference[k, i] - _quantised(y[i], loop.sensor_resolution[i])
    for a in range(len(loop.actuators)):
        v = state.output[a]
        for i in range(len(loop.axes)):
            v += loop.Dc[a, i] * state.error[i]
        clipped = min(max(v, loop.actuator[a, COMMAND_MIN]), loop.actuator[a, COMMAND_MAX])
        if clipped != v:
            state.counts[a, SATURATED] += 1
        state.output[a] = clipped - v
        state.command[a] = _quantised(clipped, loop.actuator[a, RESOLUTION])
    for i in range(len(loop.states)):
        total = state.x_next[i]
        for j in range(len(loop.axes)):
            total += loop.Bc[i, j] * state.error[j]
        for a in range(len(loop.actuators)):
            total += loop.L[i, a] * state.output[a]
        state.x[i] = total


@_inline
def _amplifier_step(loop, state, due, u, u_next):  # type: ignore[no-untyped-def]
    """The drive at the end of the plant step, from u towards the command that is due."""
    for a in range(len(loop.actuators)):
        move = (state.pending[due, a] - u[a]) * loop.actuator[a, FOLLOW]
        if abs(move) > loop.actuator[a, SLEW_STEP]:
            state.counts[a, SLEW_LIMITED] += 1
            move = _clamp(move, loop.actuator[a, SLEW_STEP])
        u_next[a] = u[a] + move


@_compile
def closed_loop(plant, plant_state, loop, loop_state, reference, output, command, drive):  # type: ignore[no-untyped-def]
    """The sampled loop over ``reference`` (samples, axes), one row per control sample.

    At each sample the output is measured, the controller computes a command, and the plant takes
    ``steps_per_sample`` steps under the command that left the controller ``delay_steps`` plant steps ago. Fills, at
    the sample instants, ``output`` (samples, axes), ``command`` and ``drive`` (samples, actuators; before and behind
    the amplifier). The states are left at the end, so that a following call continues.
    """
    command[:, :] = 0.0
    if loop.feedforward:  # command holds it until the sample's own command takes its place
        _inverse(loop, loop_state, reference, plant.step_s * loop.steps_per_sample, command)
    ring = loop_state.pending
    length = ring.shape[0]
    position = loop_state.position[0]
    for k in range(reference.shape[0]):
        _control_sample(loop, loop_state, reference, command, k, plant_state.y)
        for i in range(len(plant.outputs)):
            output[k, i] = plant_state.y[i]
        for a in range(len(plant.actuators)):
            command[k, a] = loop_state.command[a]
            drive[k, a] = plant_state.u[a]
        for _ in range(loop.steps_per_sample):
            for a in range(len(plant.actuators)):
                ring[position, a] = loop_state.command[a]
            due = position - loop.delay_steps
            if due < 0:
                due += length
            _predict(plant, plant_state)
            _amplifier_step(loop, loop_state, due, plant_state.u, plant_state.u_next)
            _plant_step(plant, plant_state)
            position += 1
            if position == length:
                position = 0
    loop_state.position[0] = position


def rows(matrix: Floats) -> Rows:
    """A dense matrix as rows without its zeros."""
    places = [np.flatnonzero(row) for row in matrix]
    return Rows(
        start=np.cumsum([0] + [p.size for p in places]).astype(np.uint64),
        column=np.concatenate([*places, np.zeros(0, dtype=np.int64)]).astype(np.uint64),
        value=np.concatenate([*(row[p] for row, p in zip(matrix, places, strict=True)), np.zeros(0)]),
    )
