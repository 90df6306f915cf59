"""Slow, obvious twins of the compiled kernels: series, dense matrices, plain Python and adaptive solvers.

Written from the equations, not from the kernels: no closed form of the hysteresis, no prepared discrete matrices, no
sparse storage, no ring buffer. The two builders at the end are the only lines that know the kernels' records.

Plant: x' = A x + B u + E z, q = F x + G u, z = H[q, q'], y = C x + D u + K z, all as deviations from rest.
"""

from itertools import pairwise
from math import exp
from typing import NamedTuple

import numpy as np
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from microrad import kernels


class BoucWen(NamedTuple):
    """Parameters of h' = epsilon e^(delta |c|) q' - beta q' |h| - alpha |q'| h and z = d1 e^(-d2 c) q + h."""

    d1: float
    d2: float
    epsilon: float
    delta: float
    alpha: float
    beta: float
    rate_limit: float
    bias: float


class Mirror(NamedTuple):
    """A continuous plant with its bank: Bouc-Wen elements first, then play operators."""

    A: np.ndarray
    B: np.ndarray
    E: np.ndarray
    F: np.ndarray
    G: np.ndarray
    C: np.ndarray
    D: np.ndarray
    K: np.ndarray
    bouc_wen: tuple[BoucWen, ...] = ()
    play_threshold: tuple[float, ...] = ()
    play_weight: tuple[float, ...] = ()


def compose(*, states=0, actuators=1, outputs=1, bouc_wen=(), play_threshold=(), play_weight=(), **matrices):
    """A mirror from the matrices that are given; the others are zero."""
    elements = len(bouc_wen) + len(play_threshold)
    rows = {
        "A": states,
        "B": states,
        "E": states,
        "F": elements,
        "G": elements,
        "C": outputs,
        "D": outputs,
        "K": outputs,
    }
    columns = {"A": states, "F": states, "C": states, "B": actuators, "G": actuators, "D": actuators}
    filled = {name: np.zeros((rows[name], columns.get(name, elements))) for name in rows}
    for name, matrix in matrices.items():
        filled[name][...] = matrix
    return Mirror(
        **filled, bouc_wen=tuple(bouc_wen), play_threshold=tuple(play_threshold), play_weight=tuple(play_weight)
    )


# ------------------------------------------------------------------------------------------------ one element


def clamped_rate(rate, limit):
    """Rate held within the identified range, and whether it had to be."""
    return max(-limit, min(limit, rate)), int(abs(rate) > limit)


def output(row, q, c, h):
    """z of a Bouc-Wen element at q, (clamped) rate c and hysteresis h: zero at rest."""
    return row.d1 * exp(-row.d2 * c) * (q + row.bias) - row.d1 * row.bias + h


def taylor(h, forcing, decay, time):
    """h after ``time`` of h' = forcing - decay h, by its Taylor series, to the last digit of the number type."""
    term = (forcing - decay * h) * time
    order = 1
    total = h
    while total + term != total:
        total += term
        order += 1
        term *= -decay * time / order
    return total


def bouc_wen_step(h, travel, epsilon_rate, alpha, beta):
    """h after a drive that moves by ``travel`` at constant rate; floats or Decimals.

    h' = epsilon_rate q' - beta q' |h| - alpha |q'| h is summed as a Taylor series over pieces of the step; a piece
    over which h changes sign is cut at the sign change, found by bisection.
    """
    one = type(h)(1)
    forcing, remaining = epsilon_rate * travel, one
    while remaining > 0:
        side = (h > 0) - (h < 0) or (forcing > 0) - (forcing < 0)
        decay = beta * travel * side + alpha * abs(travel)
        piece = min(remaining, 1 / (4 * abs(decay) + one))
        end = taylor(h, forcing, decay, piece)
        if end * side < 0:
            low, high = piece * 0, piece
            while low < (middle := (low + high) / 2) < high:
                low, high = (low, middle) if taylor(h, forcing, decay, middle) * side < 0 else (middle, high)
            piece, end = high, h * 0
        h, remaining = end, remaining - piece
    return h


def bouc_wen_step_solved(h, q, q_next, step_s, row, method="DOP853"):
    """The same step by an adaptive solver, in time."""
    rate = (q_next - q) / step_s
    c, _ = clamped_rate(rate, row.rate_limit)

    def slope(_, h):
        return row.epsilon * exp(row.delta * abs(c)) * rate - row.beta * rate * abs(h) - row.alpha * abs(rate) * h

    solution = solve_ivp(slope, (0, step_s), [h], method=method, rtol=1e-12, atol=1e-15)
    assert solution.success, solution.message
    return float(solution.y[0, -1])


def bouc_wen_response(drive, step_s, row, h0=0.0, method="DOP853"):
    """Output, hysteresis and number of clamped steps of Eq. 3 for a drive linear between its samples."""
    h, clamped = [h0], 0
    z = [output(row, drive[0], 0.0, h0)]
    for q, q_next in pairwise(drive):
        c, beyond = clamped_rate((q_next - q) / step_s, row.rate_limit)
        clamped += beyond
        h.append(bouc_wen_step_solved(h[-1], q, q_next, step_s, row, method))
        z.append(output(row, q_next, c, h[-1]))
    return np.array(z), np.array(h), clamped


def play(p, q, threshold):
    """The play operator: the state follows the drive at the distance ``threshold``."""
    return max(q - threshold, min(q + threshold, p))


def play_response(drive, thresholds, state0):
    """States of a bank of play operators, shape (samples, operators)."""
    rows, p = [], list(state0)
    for q in drive:
        p = [play(state, q, threshold) for state, threshold in zip(p, thresholds, strict=True)]
        rows.append(p)
    return np.array(rows).reshape(len(drive), len(p))


# ------------------------------------------------------------------------------------------------ the plant


class MirrorTwin:
    """The plant stepped with dense matrix exponentials: predict q with z held, advance the bank, redo the step."""

    def __init__(self, mirror, step_s):
        self.mirror, self.step_s = mirror, step_s
        n, nu = mirror.B.shape
        nz = mirror.E.shape[1]
        m = nu + nz
        generator = np.zeros((n + 2 * m, n + 2 * m))  # of (x, w, w') with w = (u, z) linear in time
        generator[:n, :n] = mirror.A
        generator[:n, n : n + m] = np.hstack([mirror.B, mirror.E])
        generator[n : n + m, n + m :] = np.eye(m)
        self.transition = expm(generator * step_s)
        self.x, self.u, self.z, self.q = np.zeros(n), np.zeros(nu), np.zeros(nz), np.zeros(nz)
        self.h = [0.0] * len(mirror.bouc_wen)
        self.p = [0.0] * len(mirror.play_threshold)
        self.clamped = [0] * len(mirror.bouc_wen)

    def linear(self, u_next, z_next):
        """x at the end of a step over which u and z are linear in time."""
        start = np.concatenate([self.u, self.z])
        slope = (np.concatenate([u_next, z_next]) - start) / self.step_s
        return (self.transition @ np.concatenate([self.x, start, slope]))[: len(self.x)]

    def advance_bank(self, q_next):
        z = []
        for i, row in enumerate(self.mirror.bouc_wen):
            travel = float(q_next[i] - self.q[i])
            c, beyond = clamped_rate(travel / self.step_s, row.rate_limit)
            self.clamped[i] += beyond
            self.h[i] = bouc_wen_step(self.h[i], travel, row.epsilon * exp(row.delta * abs(c)), row.alpha, row.beta)
            z.append(output(row, q_next[i], c, self.h[i]))
        for i, (threshold, weight) in enumerate(zip(self.mirror.play_threshold, self.mirror.play_weight, strict=True)):
            self.p[i] = play(self.p[i], q_next[len(self.h) + i], threshold)
            z.append(weight * self.p[i])
        self.q = q_next
        return np.array(z)

    def step(self, u_next):
        u_next = np.asarray(u_next, dtype=float)
        predicted = self.linear(u_next, self.z)
        z_next = self.advance_bank(self.mirror.F @ predicted + self.mirror.G @ u_next)
        self.x, self.u, self.z = self.linear(u_next, z_next), u_next, z_next

    def output(self):
        return self.mirror.C @ self.x + self.mirror.D @ self.u + self.mirror.K @ self.z


def open_loop(mirror, step_s, drive):
    """Output and bank output for a sampled drive, and the twin at its end."""
    twin = MirrorTwin(mirror, step_s)
    y, z = [], []
    for u in drive:
        twin.step(u)
        y.append(twin.output())
        z.append(twin.z)
    return np.array(y), np.array(z), twin


def reference_solution(mirror, drive, drive_rate, times, rtol=1e-11, atol=1e-13):
    """Output of the continuous plant (Bouc-Wen elements only) at ``times`` for a smooth drive, by an adaptive solver.

    Where z depends on q' and q' on z (d2 and F E both non-zero) the pair is iterated to its fixed point.
    """
    assert not mirror.play_threshold
    n = len(mirror.A)

    def bank(x, h, t):
        u, z = drive(t), np.array(h)
        for _ in range(30):
            rate = mirror.F @ (mirror.A @ x + mirror.B @ u + mirror.E @ z) + mirror.G @ drive_rate(t)
            q = mirror.F @ x + mirror.G @ u
            last = z
            z = np.array(
                [
                    output(row, q[i], clamped_rate(rate[i], row.rate_limit)[0], h[i])
                    for i, row in enumerate(mirror.bouc_wen)
                ]
            )
            if np.array_equal(z, last):
                break
        return z, rate

    def slope(t, state):
        x, h = state[:n], state[n:]
        z, rate = bank(x, h, t)
        h_slope = []
        for i, row in enumerate(mirror.bouc_wen):
            c, _ = clamped_rate(rate[i], row.rate_limit)
            push = row.epsilon * exp(row.delta * abs(c)) * rate[i]
            h_slope.append(push - row.beta * rate[i] * abs(h[i]) - row.alpha * abs(rate[i]) * h[i])
        return np.concatenate([mirror.A @ x + mirror.B @ drive(t) + mirror.E @ z, h_slope])

    rest = np.zeros(n + len(mirror.bouc_wen))
    solution = solve_ivp(
        slope, (0, times[-1]), rest, t_eval=times, method="DOP853", rtol=rtol, atol=atol, max_step=times[1] - times[0]
    )
    assert solution.success, solution.message
    z = np.array([bank(state[:n], state[n:], t)[0] for t, state in zip(times, solution.y.T, strict=True)])
    u = np.array([drive(t) for t in times])
    return solution.y[:n].T @ mirror.C.T + u @ mirror.D.T + z @ mirror.K.T


# ------------------------------------------------------------------------------------------------ the sampled loop


class Loop(NamedTuple):
    """A sampled controller, feedforward and amplifier as dense matrices.

    v = Cc xc + Dc e + feedforward, command = round(clip(v)), xc <- Ac xc + Bc e + L (clip(v) - v), e = r - round(y).
    """

    steps_per_sample: int
    delay_steps: int
    Ac: np.ndarray
    Bc: np.ndarray
    Cc: np.ndarray
    Dc: np.ndarray
    L: np.ndarray
    command_min: np.ndarray
    command_max: np.ndarray
    drive_resolution: np.ndarray
    sensor_resolution: np.ndarray
    amplifier_factor: np.ndarray
    slew_step: np.ndarray
    allocation: np.ndarray
    inverse_direct: np.ndarray
    inverse_bouc_wen: tuple[BoucWen, ...]
    inverse_bouc_wen_actuator: tuple[int, ...]
    inverse_play_threshold: tuple[float, ...]
    inverse_play_weight: tuple[float, ...]
    inverse_play_actuator: tuple[int, ...]


def idle_loop(actuators, axes, controllers=0):
    """A loop that does nothing: no controller, no feedforward, ideal converters and amplifier, no limits."""

    def each(value):
        return np.full(actuators, value)

    return Loop(
        steps_per_sample=1,
        delay_steps=0,
        Ac=np.zeros((controllers, controllers)),
        Bc=np.zeros((controllers, axes)),
        Cc=np.zeros((actuators, controllers)),
        Dc=np.zeros((actuators, axes)),
        L=np.zeros((controllers, actuators)),
        command_min=each(-np.inf),
        command_max=each(np.inf),
        drive_resolution=each(0.0),
        sensor_resolution=np.zeros(axes),
        amplifier_factor=each(1.0),
        slew_step=each(np.inf),
        allocation=np.zeros((actuators, axes)),
        inverse_direct=each(0.0),
        inverse_bouc_wen=(),
        inverse_bouc_wen_actuator=(),
        inverse_play_threshold=(),
        inverse_play_weight=(),
        inverse_play_actuator=(),
    )


class InverseTwin:
    """Feedforward u = (r - h + d1 bias) / (d1 e^(-d2 q')) - bias (Eq. 4) with q = r / d1, plus inverse plays."""

    def __init__(self, loop, sample_s):
        self.loop, self.sample_s = loop, sample_s
        self.rows = loop.inverse_bouc_wen
        self.target = np.zeros(len(loop.allocation))
        self.h = [0.0] * len(self.rows)
        self.p = [0.0] * len(loop.inverse_play_threshold)
        self.clamped = [0] * len(self.rows)

    def sample(self, reference):
        loop = self.loop
        target = loop.allocation @ reference
        u = loop.inverse_direct * target
        for i, row in enumerate(self.rows):
            actuator = loop.inverse_bouc_wen_actuator[i]
            travel = float(target[actuator] - self.target[actuator]) / row.d1
            c, beyond = clamped_rate(travel / self.sample_s, row.rate_limit)
            self.clamped[i] += beyond
            self.h[i] = bouc_wen_step(self.h[i], travel, row.epsilon * exp(row.delta * abs(c)), row.alpha, row.beta)
            static = target[actuator] - self.h[i] + row.d1 * row.bias
            u[actuator] += static / (row.d1 * exp(-row.d2 * c)) - row.bias
        for i, actuator in enumerate(loop.inverse_play_actuator):
            self.p[i] = play(self.p[i], target[actuator], loop.inverse_play_threshold[i])
            u[actuator] += loop.inverse_play_weight[i] * self.p[i]
        self.target = target
        return u


def rounded(value, resolution):
    """The nearest multiple of the resolution; 0 is an ideal converter."""
    return np.array([v if d == 0 else d * round(v / d) for v, d in zip(value, resolution, strict=True)])


class LoopRun(NamedTuple):
    """What a sampled loop did: one row per control sample, and its counters."""

    output: np.ndarray
    command: np.ndarray
    drive: np.ndarray
    saturated: np.ndarray
    slew_limited: np.ndarray
    clamped: list[int]
    inverse_clamped: list[int]


def closed_loop(mirror, step_s, loop, reference):
    """The sampled loop, with the whole history of commands in a list."""
    twin = MirrorTwin(mirror, step_s)
    inverse = InverseTwin(loop, step_s * loop.steps_per_sample)
    actuators = mirror.B.shape[1]
    xc = np.zeros(len(loop.Ac))
    saturated, slew_limited = np.zeros(actuators, dtype=int), np.zeros(actuators, dtype=int)
    issued = []  # the command in force at the controller, one per plant step
    rows = []
    for r in reference:
        y = twin.output()
        e = r - rounded(y, loop.sensor_resolution)
        v = loop.Cc @ xc + loop.Dc @ e + inverse.sample(r)
        clipped = np.minimum(np.maximum(v, loop.command_min), loop.command_max)
        saturated += clipped != v
        xc = loop.Ac @ xc + loop.Bc @ e + loop.L @ (clipped - v)
        command = rounded(clipped, loop.drive_resolution)
        rows.append((y, command, twin.u))
        for _ in range(loop.steps_per_sample):
            issued.append(command)
            arrived = len(issued) - 1 - loop.delay_steps
            target = issued[arrived] if arrived >= 0 else np.zeros(actuators)
            move = (target - twin.u) * loop.amplifier_factor
            limited = np.minimum(np.maximum(move, -loop.slew_step), loop.slew_step)
            slew_limited += limited != move
            twin.step(twin.u + limited)
    y, command, drive = (np.array(column) for column in zip(*rows, strict=True))
    return LoopRun(y, command, drive, saturated, slew_limited, twin.clamped, inverse.clamped)


# ------------------------------------------------------------------------------------------------ the kernels' records


def first_order_hold(A, B, step_s):
    """(Ad, B0, B1) of x[k+1] = Ad x[k] + B0 w[k] + B1 w[k+1] for x' = A x + B w with w linear over the step."""
    n, m = B.shape
    generator = np.zeros((n + 2 * m, n + 2 * m))
    generator[:n, : n + m] = np.hstack([A, B]) * step_s
    generator[n : n + m, n + m :] = np.eye(m)
    whole = expm(generator)
    B1 = whole[:n, n + m :]
    return whole[:n, :n], whole[:n, n : n + m] - B1, B1


def by_rows(matrix):
    """A dense matrix, stored by rows without its zeros."""
    row, column = np.nonzero(matrix)
    start = np.searchsorted(row, np.arange(len(matrix) + 1))
    return kernels.Rows(start.astype(np.uint64), column.astype(np.uint64), matrix[row, column])


def build_plant(mirror, step_s):
    """The kernels' plant, and its state at rest."""
    n, nu = mirror.B.shape
    nb, nz, ny = len(mirror.bouc_wen), mirror.E.shape[1], len(mirror.C)
    Ad, B0, B1 = first_order_hold(mirror.A, mirror.B, step_s)
    _, E0, E1 = first_order_hold(mirror.A, mirror.E, step_s)
    even = n + n % 2
    diagonal, coupling, rest = np.zeros(even), np.zeros(even), np.zeros((even, even))
    for i, j in np.ndindex(n, n):
        if i == j:
            diagonal[i] = Ad[i, j]
        elif i // 2 == j // 2:
            coupling[i] = Ad[i, j]
        else:
            rest[i, j] = Ad[i, j]
    plant = kernels.Plant(
        step_s=float(step_s),
        states=(0,) * n,
        actuators=(0,) * nu,
        outputs=(0,) * ny,
        elements=(0,) * nb,
        feedback=bool(np.any(mirror.F)),
        direct=bool(np.any(mirror.B) or np.any(mirror.D)),
        diagonal=diagonal,
        coupling=coupling,
        rest=by_rows(rest),
        B0=np.ascontiguousarray(B0),
        B1=np.ascontiguousarray(B1),
        E_held=E0 + E1,
        E1=np.ascontiguousarray(E1),
        F=mirror.F,
        G=mirror.G,
        C=mirror.C,
        D=mirror.D,
        CE1=mirror.C @ E1,
        K=mirror.K,
        bouc_wen=np.array(mirror.bouc_wen, dtype=float).reshape(nb, 8),
        play_threshold=np.array(mirror.play_threshold, dtype=float),
        play_weight=np.array(mirror.play_weight, dtype=float),
    )
    state = kernels.PlantState(
        x=np.zeros(even),
        x_next=np.zeros(even),
        u=np.zeros(nu),
        u_next=np.zeros(nu),
        y=np.zeros(ny),
        bank=np.zeros((nz, 4)),
        clamped=np.zeros(nb, dtype=np.int64),
    )
    return plant, state


def build_loop(loop):
    """The kernels' loop, and its state at rest."""
    actuators, axes = loop.allocation.shape
    controllers, elements = len(loop.Ac), len(loop.inverse_bouc_wen)
    feedforward = elements > 0 or len(loop.inverse_play_threshold) > 0 or bool(np.any(loop.inverse_direct))
    columns = (loop.command_min, loop.command_max, loop.drive_resolution, loop.amplifier_factor, loop.slew_step)
    record = kernels.Loop(
        actuators=(0,) * actuators,
        axes=(0,) * axes,
        states=(0,) * controllers,
        inverse_elements=(0,) * elements,
        feedforward=feedforward,
        steps_per_sample=loop.steps_per_sample,
        delay_steps=loop.delay_steps,
        Ac=loop.Ac,
        Bc=loop.Bc,
        Cc=loop.Cc,
        Dc=loop.Dc,
        L=loop.L,
        actuator=np.column_stack(columns).astype(float),
        sensor_resolution=loop.sensor_resolution,
        allocation=loop.allocation,
        inverse_direct=loop.inverse_direct,
        inverse_bouc_wen=np.array(loop.inverse_bouc_wen, dtype=float).reshape(elements, 8),
        inverse_bouc_wen_actuator=np.array(loop.inverse_bouc_wen_actuator, dtype=np.uint64),
        inverse_play_threshold=np.array(loop.inverse_play_threshold, dtype=float),
        inverse_play_weight=np.array(loop.inverse_play_weight, dtype=float),
        inverse_play_actuator=np.array(loop.inverse_play_actuator, dtype=np.uint64),
    )
    state = kernels.LoopState(
        x=np.zeros(controllers),
        x_next=np.zeros(controllers),
        error=np.zeros(axes),
        output=np.zeros(actuators),
        command=np.zeros(actuators),
        target=np.zeros((actuators, 2)),
        inverse_h=np.zeros(elements),
        inverse_p=np.zeros(len(loop.inverse_play_threshold)),
        pending=np.zeros((loop.delay_steps + 1, actuators)),
        position=np.zeros(1, dtype=np.int64),
        counts=np.zeros((actuators, 2), dtype=np.int64),
        inverse_clamped=np.zeros(elements, dtype=np.int64),
    )
    return record, state


def run_open_loop(mirror, step_s, drive, state=None):
    """The compiled ``open_loop`` from rest or from ``state``: output, bank, state."""
    plant, rest = build_plant(mirror, step_s)
    state = rest if state is None else state
    drive = np.ascontiguousarray(drive, dtype=float)
    output, bank = np.empty((len(drive), len(mirror.C))), np.empty((len(drive), len(mirror.G)))
    kernels.open_loop(plant, state, drive, output, bank)
    return output, bank, state


def run_closed_loop(mirror, step_s, loop, reference, states=(None, None)):
    """The compiled ``closed_loop`` from rest or from ``states``: the run, and both states."""
    plant, plant_rest = build_plant(mirror, step_s)
    record, loop_rest = build_loop(loop)
    plant_state, loop_state = states if states[0] is not None else (plant_rest, loop_rest)
    reference = np.ascontiguousarray(reference, dtype=float)
    actuators, axes = loop.allocation.shape
    output, command, drive = (np.empty((len(reference), width)) for width in (axes, actuators, actuators))
    kernels.closed_loop(plant, plant_state, record, loop_state, reference, output, command, drive)
    run = LoopRun(
        output,
        command,
        drive,
        loop_state.counts[:, kernels.SATURATED],
        loop_state.counts[:, kernels.SLEW_LIMITED],
        plant_state.clamped.tolist(),
        loop_state.inverse_clamped.tolist(),
    )
    return run, (plant_state, loop_state)
