"""The compiled loops: hysteresis, mirror and sampled closed loop, advanced sample by sample.

Arrays, floats and named tuples in, arrays out; no checks, no units, no input or output. This is the only file that
imports numba, and it stays one file: the machine-code cache of one file does not see an edit in another.
Every kernel has a slow, obvious twin in ``tests/oracles.py`` and runs unchanged under ``NUMBA_DISABLE_JIT=1``.

All quantities are deviations from the operating point (drive bias, output at rest), so zero states are at rest.
"""

from collections.abc import Callable
from math import exp, expm1, floor, log
from typing import Any, NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

_compile: Callable[[Any], Any] = numba.njit(cache=True, nogil=True, error_model="numpy")
_inline: Callable[[Any], Any] = numba.njit(cache=True, nogil=True, error_model="numpy", inline="always")

# Columns of a Bouc-Wen parameter row (Eq. 3 of SPIE 11852, 118523B).
D1, D2, EPSILON, DELTA, ALPHA, BETA, RATE_LIMIT, BIAS = range(8)

# Columns of the counters of a closed loop, one row per actuator.
SATURATED, SLEW_LIMITED = range(2)


class Plant(NamedTuple):
    """A linear system in feedback with a bank of hysteresis operators, discretised for a fixed step.

    x[k+1] = Ad x[k] + B0 u[k] + B1 u[k+1] + E0 z[k] + E1 z[k+1],  q = F x + G u,  z = H[q],  y = C x + D u + K z.

    Bouc-Wen elements come first in the rows of F and G and the columns of E and K, play operators after them.
    Ad is stored by rows (``row_start``, ``column``, ``value``), so a modal form costs what its blocks cost.
    """

    step_s: float
    row_start: Integers
    column: Integers
    value: Floats
    B0: Floats
    B1: Floats
    E0: Floats
    E1: Floats
    F: Floats
    G: Floats
    C: Floats
    D: Floats
    K: Floats
    bouc_wen: Floats
    play_threshold: Floats
    play_weight: Floats
    feedback: bool


class PlantState(NamedTuple):
    """The memory of a plant; the kernels write into these arrays. ``clamped`` counts rate-clamped steps by element."""

    x: Floats
    x_next: Floats
    u: Floats
    q: Floats
    h: Floats
    p: Floats
    z: Floats
    z_next: Floats
    y: Floats
    clamped: Integers


class Loop(NamedTuple):
    """Controller, inverse feedforward, converters and amplifier of a sampled loop, as arrays.

    Controller: xc[k+1] = Ac xc + Bc e + L (clip(v) - v),  v = Cc xc + Dc e + feedforward,  e = r - y sampled.
    Amplifier: first order, ``amplifier_factor`` = 1 - exp(-2 pi bandwidth step) (1 is ideal), slew per plant step.
    A resolution of 0 is an ideal converter.
    """

    steps_per_sample: int
    delay_steps: int
    Ac: Floats
    Bc: Floats
    Cc: Floats
    Dc: Floats
    L: Floats
    command_min: Floats
    command_max: Floats
    drive_resolution: Floats
    sensor_resolution: Floats
    amplifier_factor: Floats
    slew_step: Floats
    allocation: Floats
    inverse_direct: Floats
    inverse_bouc_wen: Floats
    inverse_bouc_wen_actuator: Integers
    inverse_play_threshold: Floats
    inverse_play_weight: Floats
    inverse_play_actuator: Integers


class LoopState(NamedTuple):
    """The memory of a sampled loop; the kernels write into these arrays.

    ``pending`` holds the commands on their way through the computation delay, ``position`` its write index.
    ``counts`` has one row per actuator: saturated samples, slew-limited plant steps.
    ``inverse_clamped`` counts rate-clamped samples of the feedforward's own elements.
    """

    xc: Floats
    xc_next: Floats
    error: Floats
    command: Floats
    feedforward: Floats
    target: Floats
    reference: Floats
    inverse_h: Floats
    inverse_p: Floats
    pending: Floats
    position: Integers
    counts: Integers
    inverse_clamped: Integers


@_inline
def _relaxed(h, forcing, decay):  # type: ignore[no-untyped-def]
    """h after unit time of h' = forcing - decay h; a series where decay vanishes."""
    if abs(decay) < 1e-5:
        return h + (forcing - decay * h) * (1.0 - decay * (0.5 - decay / 6.0))
    return h - (forcing - decay * h) * expm1(-decay) / decay


@_compile
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
    ratio = decay * h / forcing
    fraction = -h / forcing if abs(ratio) < 1e-9 else log(1.0 - ratio) / decay
    rest = max(0.0, 1.0 - fraction)
    other = alpha * abs(travel) - side * beta * travel
    return _relaxed(0.0, forcing * rest, other * rest)


@_inline
def _clamp(value, limit):  # type: ignore[no-untyped-def]
    return min(max(value, -limit), limit)


@_inline
def _play(p, q, threshold):  # type: ignore[no-untyped-def]
    return max(q - threshold, min(q + threshold, p))


@_compile
def bouc_wen_response(drive, step_s, parameters, hysteresis0):  # type: ignore[no-untyped-def]
    """Static Eq. 3 for a sampled drive, linear between samples.

    Returns (output, hysteresis, number of rate-clamped samples); the rate is the backward difference, zero at first.
    """
    n = drive.size
    output = np.empty(n)
    hysteresis = np.empty(n)
    h = hysteresis0
    clamped = 0
    previous = drive[0]
    for k in range(n):
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
    return output, hysteresis, clamped


@_compile
def play_response(drive, thresholds, state0):  # type: ignore[no-untyped-def]
    """States of play operators, shape (samples, operators): p <- max(u - r, min(u + r, p))."""
    states = np.empty((drive.size, thresholds.size))
    for j in range(thresholds.size):
        p = state0[j]
        for k in range(drive.size):
            p = _play(p, drive[k], thresholds[j])
            states[k, j] = p
    return states


@_compile
def _advance_bank(plant, state):  # type: ignore[no-untyped-def]
    """Advance every element exactly from its stored q to the q at the end of the step; fills z_next."""
    F, G = plant.F, plant.G
    elements = plant.bouc_wen.shape[0]
    for i in range(F.shape[0]):
        q = 0.0
        if plant.feedback:
            for j in range(F.shape[1]):
                q += F[i, j] * state.x_next[j]
        for j in range(G.shape[1]):
            q += G[i, j] * state.u[j]
        if i < elements:
            row = plant.bouc_wen[i]
            travel = q - state.q[i]
            rate = travel / plant.step_s
            if abs(rate) > row[RATE_LIMIT]:
                state.clamped[i] += 1
                rate = _clamp(rate, row[RATE_LIMIT])
            h = state.h[i]
            if travel != 0.0 and row[EPSILON] != 0.0:
                h = bouc_wen_step(h, travel, row[EPSILON] * exp(row[DELTA] * abs(rate)), row[ALPHA], row[BETA])
                state.h[i] = h
            state.z_next[i] = row[D1] * exp(-row[D2] * rate) * (q + row[BIAS]) - row[D1] * row[BIAS] + h
        else:
            p = _play(state.p[i - elements], q, plant.play_threshold[i - elements])
            state.p[i - elements] = p
            state.z_next[i] = plant.play_weight[i - elements] * p
        state.q[i] = q


@_compile
def _plant_step(plant, state, u_next):  # type: ignore[no-untyped-def]
    """One step with u and z linear over it: predict with z held, advance the bank, correct once (second order)."""
    x, x_next, u = state.x, state.x_next, state.u
    for i in range(x.size):
        total = 0.0
        for j in range(plant.row_start[i], plant.row_start[i + 1]):
            total += plant.value[j] * x[plant.column[j]]
        for j in range(u.size):
            total += plant.B0[i, j] * u[j] + plant.B1[i, j] * u_next[j]
        for j in range(state.z.size):
            total += (plant.E0[i, j] + plant.E1[i, j]) * state.z[j]
        x_next[i] = total
    for j in range(u.size):
        u[j] = u_next[j]
    _advance_bank(plant, state)
    for i in range(x.size):
        total = x_next[i]
        for j in range(state.z.size):
            total += plant.E1[i, j] * (state.z_next[j] - state.z[j])
        x[i] = total
    for j in range(state.z.size):
        state.z[j] = state.z_next[j]


@_compile
def _plant_output(plant, state):  # type: ignore[no-untyped-def]
    for i in range(state.y.size):
        total = 0.0
        for j in range(state.x.size):
            total += plant.C[i, j] * state.x[j]
        for j in range(state.u.size):
            total += plant.D[i, j] * state.u[j]
        for j in range(state.z.size):
            total += plant.K[i, j] * state.z[j]
        state.y[i] = total


@_compile
def open_loop(plant, state, drive, output, bank):  # type: ignore[no-untyped-def]
    """Response of the mirror to ``drive`` (samples, actuators), linear between samples spaced by the plant's step.

    Fills ``output`` (samples, outputs) and ``bank`` (samples, elements; z) and leaves ``state`` at the last sample,
    so that a following call continues. The first sample is reached from the stored state in one step.
    """
    for k in range(drive.shape[0]):
        _plant_step(plant, state, drive[k])
        _plant_output(plant, state)
        output[k] = state.y
        bank[k] = state.z


@_compile
def _inverse(loop, state, reference, sample_s):  # type: ignore[no-untyped-def]
    """Causal inverse-multiplicative feedforward (Eq. 4), and the closed-form inverse of play operators.

    u = (r - h + d1 bias) / (d1 exp(-d2 q')) - bias, with h and q' driven by the reference, q = r / d1: taking the rate
    from the feedforward's own last sample makes it chatter at the sample rate.
    """
    for j in range(state.feedforward.size):
        target = 0.0
        for i in range(reference.size):
            target += loop.allocation[j, i] * reference[i]
        previous = state.target[j]
        u = loop.inverse_direct[j] * target
        for e in range(loop.inverse_bouc_wen_actuator.size):
            if loop.inverse_bouc_wen_actuator[e] == j:
                row = loop.inverse_bouc_wen[e]
                travel = (target - previous) / row[D1]
                rate = travel / sample_s
                if abs(rate) > row[RATE_LIMIT]:
                    state.inverse_clamped[e] += 1
                    rate = _clamp(rate, row[RATE_LIMIT])
                h = bouc_wen_step(
                    state.inverse_h[e], travel, row[EPSILON] * exp(row[DELTA] * abs(rate)), row[ALPHA], row[BETA]
                )
                state.inverse_h[e] = h
                u += (target - h + row[D1] * row[BIAS]) / (row[D1] * exp(-row[D2] * rate)) - row[BIAS]
        for e in range(loop.inverse_play_actuator.size):
            if loop.inverse_play_actuator[e] == j:
                p = _play(state.inverse_p[e], target, loop.inverse_play_threshold[e])
                state.inverse_p[e] = p
                u += loop.inverse_play_weight[e] * p
        state.feedforward[j] = u
        state.target[j] = target


@_inline
def _quantised(value, resolution):  # type: ignore[no-untyped-def]
    return floor(value / resolution + 0.5) * resolution if resolution > 0.0 else value


@_compile
def _control_sample(loop, state, reference, y, sample_s):  # type: ignore[no-untyped-def]
    """One sample of the controller: error, feedforward, output, clip with anti-windup, converter."""
    for i in range(y.size):
        state.error[i] = reference[i] - _quantised(y[i], loop.sensor_resolution[i])
    _inverse(loop, state, reference, sample_s)
    xc, xc_next, error = state.xc, state.xc_next, state.error
    for i in range(xc.size):
        total = 0.0
        for j in range(xc.size):
            total += loop.Ac[i, j] * xc[j]
        for j in range(error.size):
            total += loop.Bc[i, j] * error[j]
        xc_next[i] = total
    for a in range(state.command.size):
        v = state.feedforward[a]
        for j in range(xc.size):
            v += loop.Cc[a, j] * xc[j]
        for j in range(error.size):
            v += loop.Dc[a, j] * error[j]
        clipped = min(max(v, loop.command_min[a]), loop.command_max[a])
        if clipped != v:
            state.counts[a, SATURATED] += 1
            for i in range(xc.size):
                xc_next[i] += loop.L[i, a] * (clipped - v)
        state.command[a] = _quantised(clipped, loop.drive_resolution[a])
    for i in range(xc.size):
        xc[i] = xc_next[i]


@_compile
def _amplifier_step(loop, state, u, target, u_next):  # type: ignore[no-untyped-def]
    for a in range(u.size):
        move = (target[a] - u[a]) * loop.amplifier_factor[a]
        limit = loop.slew_step[a]
        if abs(move) > limit:
            state.counts[a, SLEW_LIMITED] += 1
            move = _clamp(move, limit)
        u_next[a] = u[a] + move


@_compile
def closed_loop(plant, plant_state, loop, loop_state, reference, output, command, drive):  # type: ignore[no-untyped-def]
    """The sampled loop over ``reference`` (samples, axes), one row per control sample.

    At each sample the output is measured, the controller computes a command, and the plant takes
    ``steps_per_sample`` steps under the command that left the controller ``delay_steps`` plant steps ago. Fills, at
    the sample instants, ``output`` (samples, axes), ``command`` and ``drive`` (samples, actuators; before and behind
    the amplifier). The states are left at the end, so that a following call continues.
    """
    sample_s = plant.step_s * loop.steps_per_sample
    u_next = np.empty(plant_state.u.size)
    ring = loop_state.pending
    length = ring.shape[0]
    position = loop_state.position[0]
    for k in range(reference.shape[0]):
        _plant_output(plant, plant_state)
        _control_sample(loop, loop_state, reference[k], plant_state.y, sample_s)
        for i in range(plant_state.y.size):
            output[k, i] = plant_state.y[i]
        for a in range(u_next.size):
            command[k, a] = loop_state.command[a]
            drive[k, a] = plant_state.u[a]
        for _ in range(loop.steps_per_sample):
            for a in range(u_next.size):
                ring[position, a] = loop_state.command[a]
            due = position - loop.delay_steps
            if due < 0:
                due += length
            _amplifier_step(loop, loop_state, plant_state.u, ring[due], u_next)
            _plant_step(plant, plant_state, u_next)
            position += 1
            if position == length:
                position = 0
    loop_state.position[0] = position
