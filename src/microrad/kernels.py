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

# Columns of the counters of a closed loop, one row per actuator.
SATURATED, SLEW_LIMITED = range(2)


# A tuple whose length is a count: the length is part of the compiled type, so that loops over it have no overhead (they
# took a third of the time of a one-axis step). Its items mean nothing.
Count = tuple[int, ...]


class Rows(NamedTuple):
    """A matrix by rows without its zeros: row i is value[start[i]:start[i + 1]] at those columns."""

    start: Indices
    column: Indices
    value: Floats


class Plant(NamedTuple):
    """A linear system in feedback with a bank of hysteresis operators, discretised for a fixed step.

    x[k+1] = Ad x[k] + B0 u[k] + B1 u[k+1] + E0 z[k] + E1 z[k+1],  q = F x + G u,  z = H[q],  y = C x + D u + K z.

    The signals stand in one vector w = (x, u, u at the step's end, z). ``transition`` predicts x with z held, rows
    (Ad, B0, B1, E0 + E1); ``correction`` is E1, dense; ``from_state`` holds the rows of F, acting on the predicted x,
    ``from_drive`` the rows (0, 0, G, 0) and ``output`` (C, 0, D, K), acting on w. Bouc-Wen elements come first in q and z,
    play operators after them. A modal Ad costs what its blocks cost.
    """

    step_s: float
    states: int
    actuators: Count
    outputs: Count
    transition: Rows
    correction: Floats
    from_state: Rows
    from_drive: Rows
    output: Rows
    bouc_wen: Floats
    play_threshold: Floats
    play_weight: Floats


class PlantState(NamedTuple):
    """The memory of a plant; the kernels write into these arrays. ``clamped`` counts rate-clamped steps by element.

    ``w`` as in Plant, ``q`` by element, ``h`` by Bouc-Wen element, ``p`` by play operator; ``scratch`` has no meaning
    between steps.
    """

    w: Floats
    q: Floats
    h: Floats
    p: Floats
    scratch: Floats
    clamped: Integers


class Loop(NamedTuple):
    """Controller, inverse feedforward, converters and amplifier of a sampled loop, as arrays.

    Controller: xc[k+1] = Ac xc + Bc e + L (clip(v) - v),  v = Cc xc + Dc e + feedforward,  e = r - y sampled, with the
    rows of (Ac, Bc) in ``update`` and of (Cc, Dc) in ``command``, both acting on (xc, e); L is ``anti_windup``.
    Amplifier: first order, ``amplifier_factor`` = 1 - exp(-2 pi bandwidth step) (1 is ideal), slew per plant step.
    A resolution of 0 is an ideal converter. ``allocation`` (actuators, axes) turns references into actuator targets.
    """

    actuators: Count
    axes: Count
    steps_per_sample: int
    delay_steps: int
    update: Rows
    command: Rows
    anti_windup: Floats
    command_min: Floats
    command_max: Floats
    drive_resolution: Floats
    sensor_resolution: Floats
    amplifier_factor: Floats
    slew_step: Floats
    allocation: Floats
    inverse_direct: Floats
    inverse_bouc_wen: Floats
    inverse_bouc_wen_actuator: Indices
    inverse_play_threshold: Floats
    inverse_play_weight: Floats
    inverse_play_actuator: Indices


class LoopState(NamedTuple):
    """The memory of a sampled loop; the kernels write into these arrays.

    ``w`` is (xc, e). ``pending`` holds the commands on their way through the computation delay, ``position`` its write
    index. ``counts`` has one row per actuator: saturated samples, slew-limited plant steps. ``inverse_clamped`` counts
    rate-clamped samples of the feedforward's own elements. ``scratch`` has no meaning between samples.
    """

    w: Floats
    scratch: Floats
    command: Floats
    target: Floats
    feedforward: Floats
    inverse_h: Floats
    inverse_p: Floats
    pending: Floats
    position: Integers
    counts: Integers
    inverse_clamped: Integers


@_inline
def _relaxed(h, forcing, decay):  # type: ignore[no-untyped-def]
    """h after unit time of h' = forcing - decay h, that is h + (forcing - decay h) (1 - exp(-decay)) / decay.

    The last factor is its Taylor series where the difference would cancel: 12 terms, 1e-16 at 0.3 (expm1 costs twice).
    """
    if abs(decay) < 0.3:
        d, d2 = decay, decay * decay
        d4 = d2 * d2
        low = (1.0 - d * (1.0 / 2.0)) + d2 * (1.0 / 6.0 - d * (1.0 / 24.0))
        middle = (1.0 / 120.0 - d * (1.0 / 720.0)) + d2 * (1.0 / 5040.0 - d * (1.0 / 40320.0))
        high = (1.0 / 362880.0 - d * (1.0 / 3628800.0)) + d2 * (1.0 / 39916800.0 - d * (1.0 / 479001600.0))
        return h + (forcing - decay * h) * (low + d4 * (middle + d4 * high))
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
            h, travel, parameters[EPSILON] * exp(parameters[DELTA] * abs(rate)), parameters[ALPHA], parameters[BETA]
        )
        linear = parameters[D1] * exp(-parameters[D2] * rate) * (drive[k] + parameters[BIAS])
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
def _plant_step(plant, state):  # type: ignore[no-untyped-def]
    """One step to the u at the step's end that stands in w, with u and z linear over the step.

    Predict x with z held, advance every element exactly from its stored q to the predicted q, and correct x once for
    the change of z: second order, and nothing is iterated.
    """
    w, x, n, m = state.w, state.scratch, plant.states, len(plant.actuators)
    for i in range(n):
        x[i] = _row(plant.transition, i, w)
    elements = plant.bouc_wen.shape[0]
    for e in range(elements):
        row = plant.bouc_wen
        q = _row(plant.from_state, e, x) + _row(plant.from_drive, e, w)
        travel = q - state.q[e]
        rate = travel / plant.step_s
        if abs(rate) > row[e, RATE_LIMIT]:
            state.clamped[e] += 1
            rate = _clamp(rate, row[e, RATE_LIMIT])
        grown = row[e, EPSILON] * exp(row[e, DELTA] * abs(rate))
        h = bouc_wen_step(state.h[e], travel, grown, row[e, ALPHA], row[e, BETA])
        z = row[e, D1] * (exp(-row[e, D2] * rate) * (q + row[e, BIAS]) - row[e, BIAS]) + h
        state.h[e] = h
        state.q[e] = q
        x[n + e] = z - w[n + 2 * m + e]
        w[n + 2 * m + e] = z
    for e in range(elements, state.q.size):
        q = _row(plant.from_state, e, x) + _row(plant.from_drive, e, w)
        p = _play(state.p[e - elements], q, plant.play_threshold[e - elements])
        z = plant.play_weight[e - elements] * p
        state.p[e - elements] = p
        state.q[e] = q
        x[n + e] = z - w[n + 2 * m + e]
        w[n + 2 * m + e] = z
    for i in range(n):
        total = x[i]
        for e in range(state.q.size):
            total += plant.correction[i, e] * x[n + e]
        w[i] = total
    for j in range(m):
        w[n + j] = w[n + m + j]


@_compile
def open_loop(plant, state, drive, output, bank):  # type: ignore[no-untyped-def]
    """Response of the mirror to ``drive`` (samples, actuators), linear between samples spaced by the plant's step.

    Fills ``output`` (samples, outputs) and ``bank`` (samples, elements; z) and leaves ``state`` at the last sample,
    so that a following call continues. The first sample is reached from the stored state in one step.
    """
    n, m = plant.states, len(plant.actuators)
    for k in range(drive.shape[0]):
        for j in range(m):
            state.w[n + m + j] = drive[k, j]
        _plant_step(plant, state)
        for i in range(len(plant.outputs)):
            output[k, i] = _row(plant.output, i, state.w)
        for i in range(bank.shape[1]):
            bank[k, i] = state.w[n + 2 * m + i]


@_inline
def _inverse(loop, state, reference, k, sample_s):  # type: ignore[no-untyped-def]
    """Causal inverse-multiplicative feedforward (Eq. 4), and the closed-form inverse of play operators.

    u = (r - h + d1 bias) / (d1 exp(-d2 q')) - bias, with h and q' driven by the reference, q = r / d1: taking the rate
    from the feedforward's own last sample makes it chatter at the sample rate.
    """
    for a in range(len(loop.actuators)):
        target = 0.0
        for i in range(len(loop.axes)):
            target += loop.allocation[a, i] * reference[k, i]
        state.scratch[a] = target - state.target[a]
        state.target[a] = target
        state.feedforward[a] = loop.inverse_direct[a] * target
    for e in range(loop.inverse_bouc_wen_actuator.size):
        row, a = loop.inverse_bouc_wen, loop.inverse_bouc_wen_actuator[e]
        travel = state.scratch[a] / row[e, D1]
        rate = travel / sample_s
        if abs(rate) > row[e, RATE_LIMIT]:
            state.inverse_clamped[e] += 1
            rate = _clamp(rate, row[e, RATE_LIMIT])
        grown = row[e, EPSILON] * exp(row[e, DELTA] * abs(rate))
        h = bouc_wen_step(state.inverse_h[e], travel, grown, row[e, ALPHA], row[e, BETA])
        state.inverse_h[e] = h
        gain = row[e, D1] * exp(-row[e, D2] * rate)
        state.feedforward[a] += (state.target[a] - h + row[e, D1] * row[e, BIAS]) / gain - row[e, BIAS]
    for e in range(loop.inverse_play_actuator.size):
        a = loop.inverse_play_actuator[e]
        p = _play(state.inverse_p[e], state.target[a], loop.inverse_play_threshold[e])
        state.inverse_p[e] = p
        state.feedforward[a] += loop.inverse_play_weight[e] * p


@_inline
def _quantised(value, resolution):  # type: ignore[no-untyped-def]
    return np.floor(value / resolution + 0.5) * resolution if resolution > 0.0 else value


@_inline
def _control_sample(loop, state, reference, output, k, sample_s):  # type: ignore[no-untyped-def]
    """One sample of the controller: error, feedforward, output, clip with anti-windup, converter."""
    w, states = state.w, state.w.size - len(loop.axes)
    for i in range(len(loop.axes)):
        w[states + i] = reference[k, i] - _quantised(output[k, i], loop.sensor_resolution[i])
    _inverse(loop, state, reference, k, sample_s)
    for i in range(states):
        state.scratch[i] = _row(loop.update, i, w)
    for a in range(len(loop.actuators)):
        v = state.feedforward[a] + _row(loop.command, a, w)
        clipped = min(max(v, loop.command_min[a]), loop.command_max[a])
        if clipped != v:
            state.counts[a, SATURATED] += 1
            for i in range(states):
                state.scratch[i] += loop.anti_windup[i, a] * (clipped - v)
        state.command[a] = _quantised(clipped, loop.drive_resolution[a])
    for i in range(states):
        w[i] = state.scratch[i]


@_inline
def _amplifier_step(loop, state, due, w, n, m):  # type: ignore[no-untyped-def]
    """The drive at the end of the plant step, towards the command that is due."""
    for a in range(m):
        move = (state.pending[due, a] - w[n + a]) * loop.amplifier_factor[a]
        if abs(move) > loop.slew_step[a]:
            state.counts[a, SLEW_LIMITED] += 1
            move = _clamp(move, loop.slew_step[a])
        w[n + m + a] = w[n + a] + move


@_compile
def closed_loop(plant, plant_state, loop, loop_state, reference, output, command, drive):  # type: ignore[no-untyped-def]
    """The sampled loop over ``reference`` (samples, axes), one row per control sample.

    At each sample the output is measured, the controller computes a command, and the plant takes
    ``steps_per_sample`` steps under the command that left the controller ``delay_steps`` plant steps ago. Fills, at
    the sample instants, ``output`` (samples, axes), ``command`` and ``drive`` (samples, actuators; before and behind
    the amplifier). The states are left at the end, so that a following call continues.
    """
    n, m, w = plant.states, len(plant.actuators), plant_state.w
    sample_s = plant.step_s * loop.steps_per_sample
    ring = loop_state.pending
    length = ring.shape[0]
    position = loop_state.position[0]
    for k in range(reference.shape[0]):
        for i in range(len(plant.outputs)):
            output[k, i] = _row(plant.output, i, w)
        _control_sample(loop, loop_state, reference, output, k, sample_s)
        for a in range(m):
            command[k, a] = loop_state.command[a]
            drive[k, a] = w[n + a]
        for _ in range(loop.steps_per_sample):
            for a in range(m):
                ring[position, a] = loop_state.command[a]
            due = position - loop.delay_steps
            if due < 0:
                due += length
            _amplifier_step(loop, loop_state, due, w, n, m)
            _plant_step(plant, plant_state)
            position += 1
            if position == length:
                position = 0
    loop_state.position[0] = position


def rows(*blocks: Floats) -> Rows:
    """Dense blocks side by side, as rows without their zeros."""
    matrix = np.hstack(blocks)
    places = [np.flatnonzero(row) for row in matrix]
    return Rows(
        start=np.cumsum([0] + [p.size for p in places]).astype(np.uint64),
        column=np.concatenate([*places, np.zeros(0, dtype=np.int64)]).astype(np.uint64),
        value=np.concatenate([*(row[p] for row, p in zip(matrix, places, strict=True)), np.zeros(0)]),
    )
