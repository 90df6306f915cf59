"""The sampled closed loop around one mirror: inverse, controller, converter, amplifier."""

import numpy as np

from microrad.core.kernels.compiler import compiled_loop, inlined
from microrad.core.kernels.hysteresis import bouc_wen_advance, clamp, near_exp, play_step, widened
from microrad.core.kernels.plant import plant_step, predict
from microrad.core.kernels.records import (
    BEFORE,
    BIAS,
    COMMAND_MAX,
    COMMAND_MIN,
    D1,
    D2,
    FOLLOW,
    NOW,
    RATE_LIMIT,
    RESOLUTION,
    SATURATED,
    SLEW_LIMITED,
    SLEW_STEP,
    WIDENING,
    WIDENING_LIMIT,
)


@compiled_loop
def inverse_drive(loop, state, reference, sample_s, feedforward):  # type: ignore[no-untyped-def]
    """Causal inverse-multiplicative feedforward (Eq. 4), and the closed-form inverse of play operators.

    u = (r - h + d1 bias) / (d1 exp(-d2 q')) - bias, with h and q' driven by the reference, q = r / d1: taking the rate
    from the feedforward's own last sample makes it chatter at the sample rate. What creep will add is taken off the
    reference first: it lags, so it is known from the samples before. The inverse needs nothing from the loop, so it
    runs ahead of it, over all of ``reference``.

    Args:
        loop: The `Loop`, for its allocation and its inverse.
        state: Its `LoopState`; what the inverse remembers is left at the last sample.
        reference: Reference of each axis, rad, shape (samples, axes).
        sample_s: Time between samples, s.
        feedforward: Drive of each actuator about its bias, V, shape (samples, actuators); written.
    """
    for k in range(reference.shape[0]):
        for a in range(len(loop.actuators)):
            target = 0.0
            for i in range(len(loop.axes)):
                target += loop.allocation[a, i] * reference[k, i]
            for j in range(loop.inverse_lag_keep.size):
                if loop.inverse_lag_actuator[j] == a:
                    target -= loop.inverse_lag_weight[j] * state.inverse_lag[j]
            state.target[a, BEFORE] = state.target[a, NOW]
            state.target[a, NOW] = target
            feedforward[k, a] = loop.inverse_direct[a] * target
        for e in range(loop.inverse_bouc_wen.shape[0]):
            row, a = loop.inverse_bouc_wen, loop.inverse_bouc_wen_actuator[e]
            travel = (state.target[a, NOW] - state.target[a, BEFORE]) / row[e, D1]
            rate = travel / sample_s
            if abs(rate) > row[e, RATE_LIMIT]:
                state.inverse_clamped[e] += 1
                rate = clamp(rate, row[e, RATE_LIMIT])
            h = bouc_wen_advance(state.inverse_h[e], travel, rate, row, e)
            state.inverse_h[e] = h
            gain = row[e, D1] * near_exp(-row[e, D2] * rate)
            feedforward[k, a] += (state.target[a, NOW] - h + row[e, D1] * row[e, BIAS]) / gain - row[e, BIAS]
        for a in range(len(loop.actuators)):
            widening = 0.0
            if loop.inverse_widening[a, WIDENING] != 0.0:
                rate = abs(state.target[a, NOW] - state.target[a, BEFORE]) / sample_s
                if rate > loop.inverse_widening[a, WIDENING_LIMIT]:
                    state.inverse_clamped[loop.inverse_bouc_wen.shape[0] + a] += 1
                    rate = loop.inverse_widening[a, WIDENING_LIMIT]
                widening = loop.inverse_widening[a, WIDENING] * rate
            for e in range(loop.inverse_play_actuator.size):
                if loop.inverse_play_actuator[e] == a:
                    threshold = widened(loop.inverse_play_threshold[e], widening)
                    p = play_step(state.inverse_p[e], state.target[a, NOW], threshold)
                    state.inverse_p[e] = p
                    feedforward[k, a] += loop.inverse_play_weight[e] * p
        for j in range(loop.inverse_lag_keep.size):
            keep = loop.inverse_lag_keep[j]
            drive = feedforward[k, loop.inverse_lag_actuator[j]]
            state.inverse_lag[j] = keep * state.inverse_lag[j] + (1.0 - keep) * drive


@inlined
def quantised(value, resolution):  # type: ignore[no-untyped-def]
    """The value at the nearest step of a converter; a resolution of 0 has none.

    Args:
        value: A number.
        resolution: Step of the converter in the same unit, not negative.
    """
    return np.floor(value / resolution + 0.5) * resolution if resolution > 0.0 else value


@inlined
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
        state.error[i] = reference[k, i] - quantised(y[i], loop.sensor_resolution[i])
    for a in range(len(loop.actuators)):
        v = state.output[a]
        for i in range(len(loop.axes)):
            v += loop.Dc[a, i] * state.error[i]
        clipped = min(max(v, loop.actuator[a, COMMAND_MIN]), loop.actuator[a, COMMAND_MAX])
        if clipped != v:
            state.counts[a, SATURATED] += 1
        state.output[a] = clipped - v
        state.command[a] = quantised(clipped, loop.actuator[a, RESOLUTION])
    for i in range(len(loop.states)):
        total = state.x_next[i]
        for j in range(len(loop.axes)):
            total += loop.Bc[i, j] * state.error[j]
        for a in range(len(loop.actuators)):
            total += loop.L[i, a] * state.output[a]
        state.x[i] = total


@inlined
def _amplifier_step(loop, state, due, u, u_next):  # type: ignore[no-untyped-def]
    """The drive at the end of the plant step, from u towards the command that is due."""
    for a in range(len(loop.actuators)):
        move = (state.pending[due, a] - u[a]) * loop.actuator[a, FOLLOW]
        if abs(move) > loop.actuator[a, SLEW_STEP]:
            state.counts[a, SLEW_LIMITED] += 1
            move = clamp(move, loop.actuator[a, SLEW_STEP])
        u_next[a] = u[a] + move


@compiled_loop
def closed_loop(plant, plant_state, loop, loop_state, reference, output, command, drive):  # type: ignore[no-untyped-def]
    """The sampled loop over ``reference``, one row per control sample.

    At each sample the output is measured, the controller computes a command, and the plant takes ``steps_per_sample``
    steps under the command that left the controller ``delay_steps`` plant steps ago. The states are left at the end, so
    that a following call continues.

    Args:
        plant: The `Plant`, with one output an axis.
        plant_state: Its `PlantState`.
        loop: The `Loop`.
        loop_state: Its `LoopState`.
        reference: Reference of each axis, rad, shape (samples, axes).
        output: Output at the sample instants, rad, shape (samples, axes); written.
        command: Command before the amplifier, about the bias, V, shape (samples, actuators); written.
        drive: Drive behind the amplifier at the sample instants, about the bias, V, shape (samples, actuators);
            written.
    """
    command[:, :] = 0.0
    if loop.feedforward:  # command holds it until the sample's own command takes its place
        inverse_drive(loop, loop_state, reference, plant.step_s * loop.steps_per_sample, command)
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
            predict(plant, plant_state)
            _amplifier_step(loop, loop_state, due, plant_state.u, plant_state.u_next)
            plant_step(plant, plant_state)
            position += 1
            if position == length:
                position = 0
    loop_state.position[0] = position
