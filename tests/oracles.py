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

from microrad.core import kernels


class BoucWen(NamedTuple):
    """Parameters of z = d1 e^(-d2 c) q + h and, with s = sign h, r = sign q' and the clamped rate c, of

    h' = epsilon e^(delta |c|) q' - |q'| |h| (alpha s + beta r + gamma + eta r s) w,
    where w = (|h| alpha / |epsilon|)^(exponent - 1).
    """

    d1: float
    d2: float
    epsilon: float
    delta: float
    alpha: float
    beta: float
    rate_limit: float
    bias: float
    gamma: float = 0.0
    eta: float = 0.0
    exponent: float = 1.0


class Operator(NamedTuple):
    """z = sum of weight x play; the thresholds above 0 grow by widening |q'|, up to the rate limit.

    The polynomial adds c1 s^2 + c2 |s| s + c3 s^3 with s = q / reach between -1 and 1.
    """

    thresholds: tuple[float, ...]
    weights: tuple[float, ...]
    widening: float = 0.0
    rate_limit: float = np.inf
    polynomial: tuple[float, float, float] = (0.0, 0.0, 0.0)
    reach: float = np.inf


class Mirror(NamedTuple):
    """A continuous plant with its bank: Bouc-Wen elements first, then operators of plays."""

    A: np.ndarray
    B: np.ndarray
    E: np.ndarray
    F: np.ndarray
    G: np.ndarray
    C: np.ndarray
    D: np.ndarray
    K: np.ndarray
    bouc_wen: tuple[BoucWen, ...] = ()
    operators: tuple[Operator, ...] = ()


def compose(*, states=0, actuators=1, outputs=1, bouc_wen=(), operators=(), **matrices):
    """A mirror from the matrices that are given; the others are zero."""
    elements = len(bouc_wen) + len(operators)
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
    return Mirror(**filled, bouc_wen=tuple(bouc_wen), operators=tuple(operators))


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


def bouc_wen_step(h, travel, epsilon_rate, alpha, beta, gamma=0, eta=0):
    """h after a drive that moves by ``travel`` at constant rate, for exponent 1; floats or Decimals.

    On the side s of zero, h' = epsilon_rate q' - |q'| (alpha + beta r s + gamma s + eta r) h. It is summed as a Taylor
    series over pieces of the step; a piece over which h changes sign is cut at the sign change, found by bisection.
    """
    one = type(h)(1)
    forcing, remaining = epsilon_rate * travel, one
    while remaining > 0:
        side = (h > 0) - (h < 0) or (forcing > 0) - (forcing < 0)
        decay = alpha * abs(travel) + beta * travel * side + gamma * abs(travel) * side + eta * travel
        piece = min(remaining, 1 / (4 * abs(decay) + one))
        end = taylor(h, forcing, decay, piece)
        if end * side < 0:
            low, high = piece * 0, piece
            while low < (middle := (low + high) / 2) < high:
                low, high = (low, middle) if taylor(h, forcing, decay, middle) * side < 0 else (middle, high)
            piece, end = high, h * 0
        h, remaining = end, remaining - piece
    return h


def hysteresis_slope(row, rate, c, h):
    """h' at the drive's rate, of which c is the clamped one."""
    r, s = np.sign(rate), np.sign(h)
    decay = row.alpha * s + row.beta * r + row.gamma + row.eta * r * s
    weight = 1.0
    if row.exponent != 1.0:
        weight = (abs(h) * row.alpha / abs(row.epsilon)) ** (row.exponent - 1.0) if row.epsilon else 0.0
    return row.epsilon * exp(row.delta * abs(c)) * rate - abs(rate) * abs(h) * decay * weight


def bouc_wen_step_solved(h, q, q_next, step_s, row, method="DOP853"):
    """The same step by an adaptive solver, in time, for any exponent."""
    rate = (q_next - q) / step_s
    c, _ = clamped_rate(rate, row.rate_limit)
    options = {"rtol": 1e-12, "atol": 1e-15}
    if row.exponent != 1.0:
        options["atol"] *= max(abs(row.epsilon), 1e-9) / row.alpha
        if method == "DOP853":  # whose first trial would overflow far outside
            options["max_step"] = step_s / (1.0 + abs(q_next - q) * row.alpha * row.exponent)
    solution = solve_ivp(
        lambda _, h: [hysteresis_slope(row, rate, c, h[0])], (0, step_s), [h], method=method, **options
    )
    assert solution.success, solution.message
    return float(solution.y[0, -1])


def bouc_wen_advance(row, h, q, q_next, step_s):
    """h of an element whose drive moves from q to q_next, and whether its rate was clamped: the step of the twins."""
    travel = float(q_next - q)
    c, beyond = clamped_rate(travel / step_s, row.rate_limit)
    if row.exponent != 1.0:
        return bouc_wen_step_solved(h, 0.0, travel, step_s, row), c, beyond
    growth = row.epsilon * exp(row.delta * abs(c))
    return bouc_wen_step(h, travel, growth, row.alpha, row.beta, row.gamma, row.eta), c, beyond


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


def widened(threshold, widening, rate):
    """A threshold at a (clamped) rate: only those above 0 grow."""
    return threshold + widening * abs(rate) if threshold > 0 else threshold


def play_response(drive, thresholds, state0):
    """States of a bank of play operators, shape (samples, operators)."""
    return widening_play_response(drive, 1.0, thresholds, 0.0, np.inf, state0)[0]


def widening_play_response(drive, step_s, thresholds, widening, rate_limit, state0):
    """States of rate-dependent plays, shape (samples, operators), and clamped samples; at rest before the first."""
    rows, p, clamped, last = [], list(state0), 0, drive[0]
    for q in drive:
        c, beyond = clamped_rate((q - last) / step_s, rate_limit)
        clamped += beyond
        p = [play(state, q, widened(r, widening, c)) for state, r in zip(p, thresholds, strict=True)]
        rows.append(p)
        last = q
    return np.array(rows).reshape(len(drive), len(p)), clamped


def lag_response(drive, step_s, time_constants, state0):
    """States of x' = (u - x) / tau for a drive linear between samples, shape (samples, lags), by an adaptive solver."""
    tau, x = np.array(time_constants), np.array(state0, dtype=float)
    rows = [x]
    for u, u_next in pairwise(drive):

        def slope(t, x, u=u, rate=(u_next - u) / step_s):
            return (u + rate * t - x) / tau

        solution = solve_ivp(slope, (0, step_s), x, method="DOP853", rtol=1e-13, atol=1e-15)
        assert solution.success, solution.message
        x = solution.y[:, -1]
        rows.append(x)
    return np.array(rows)


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
        self.p = [[0.0] * len(operator.thresholds) for operator in mirror.operators]
        self.clamped = [0] * nz

    def linear(self, u_next, z_next):
        """x at the end of a step over which u and z are linear in time."""
        start = np.concatenate([self.u, self.z])
        slope = (np.concatenate([u_next, z_next]) - start) / self.step_s
        return (self.transition @ np.concatenate([self.x, start, slope]))[: len(self.x)]

    def advance_bank(self, q_next):
        z = []
        for i, row in enumerate(self.mirror.bouc_wen):
            self.h[i], c, beyond = bouc_wen_advance(row, self.h[i], self.q[i], q_next[i], self.step_s)
            self.clamped[i] += beyond
            z.append(output(row, q_next[i], c, self.h[i]))
        for o, operator in enumerate(self.mirror.operators):
            i = len(self.h) + o
            c, beyond = clamped_rate((q_next[i] - self.q[i]) / self.step_s, operator.rate_limit)
            self.clamped[i] += beyond
            self.p[o] = [
                play(p, q_next[i], widened(r, operator.widening, c))
                for p, r in zip(self.p[o], operator.thresholds, strict=True)
            ]
            s = min(max(q_next[i] / operator.reach, -1.0), 1.0)
            powers = zip(operator.polynomial, (s**2, abs(s) * s, s**3), strict=True)
            z.append(
                sum(w * p for w, p in zip(operator.weights, self.p[o], strict=True)) + sum(c * p for c, p in powers)
            )
        self.q = q_next
        return np.array(z)

    def step(self, u_next):
        u_next = np.asarray(u_next, dtype=float)
        predicted = self.linear(u_next, self.z)
        z_next = self.advance_bank(self.mirror.F @ predicted + self.mirror.G @ u_next)
        self.x, self.u, self.z = self.linear(u_next, z_next), u_next, z_next

    def x_less_its_end(self):
        """x less what u and z at the end of the last step did to it, as kernels keep it."""
        n, m = len(self.x), self.u.size + self.z.size
        return self.x - self.transition[:n, n + m :] @ np.concatenate([self.u, self.z]) / self.step_s

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
    assert not mirror.operators
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
            h_slope.append(hysteresis_slope(row, rate[i], c, h[i]))
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
    inverse_widening: tuple[tuple[float, float], ...]  # by actuator: growth of the thresholds in s, and rate limit
    inverse_creep: tuple[tuple[float, float, int], ...]  # weight, time constant in s, actuator


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
        inverse_widening=((0.0, np.inf),) * actuators,
        inverse_creep=(),
    )


class InverseTwin:
    """Feedforward u = (r - h + d1 bias) / (d1 e^(-d2 q')) - bias (Eq. 4) with q = r / d1, plus inverse plays.

    Creep first: what the lags add at the sample is taken off r. They then see u, held over the sample.
    """

    def __init__(self, loop, sample_s):
        self.loop, self.sample_s = loop, sample_s
        self.rows = loop.inverse_bouc_wen
        self.target = np.zeros(len(loop.allocation))
        self.h = [0.0] * len(self.rows)
        self.p = [0.0] * len(loop.inverse_play_threshold)
        self.lag = [0.0] * len(loop.inverse_creep)
        self.clamped = [0] * (len(self.rows) + len(loop.allocation))

    def sample(self, reference):
        loop = self.loop
        target = loop.allocation @ reference
        for x, (weight, _, actuator) in zip(self.lag, loop.inverse_creep, strict=True):
            target[actuator] -= weight * x
        u = loop.inverse_direct * target
        for i, row in enumerate(self.rows):
            actuator = loop.inverse_bouc_wen_actuator[i]
            q, q_next = self.target[actuator] / row.d1, target[actuator] / row.d1
            self.h[i], c, beyond = bouc_wen_advance(row, self.h[i], q, q_next, self.sample_s)
            self.clamped[i] += beyond
            static = target[actuator] - self.h[i] + row.d1 * row.bias
            u[actuator] += static / (row.d1 * exp(-row.d2 * c)) - row.bias
        rates = (target - self.target) / self.sample_s
        for a, (_, limit) in enumerate(loop.inverse_widening):
            rates[a], beyond = clamped_rate(rates[a], limit)
            self.clamped[len(self.rows) + a] += beyond
        for i, actuator in enumerate(loop.inverse_play_actuator):
            growth = loop.inverse_widening[actuator][0]
            threshold = widened(loop.inverse_play_threshold[i], growth, rates[actuator])
            self.p[i] = play(self.p[i], target[actuator], threshold)
            u[actuator] += loop.inverse_play_weight[i] * self.p[i]
        self.lag = [
            taylor(x, u[actuator] / tau, 1 / tau, self.sample_s)
            for x, (_, tau, actuator) in zip(self.lag, loop.inverse_creep, strict=True)
        ]
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


def kernel_rows(bouc_wen):
    """The kernels' rows, with all columns."""
    rows = []
    for b in bouc_wen:
        per_size = b.alpha / abs(b.epsilon) if b.exponent != 1.0 and b.epsilon else 0.0
        rows.append([*b[:8], b.gamma, b.eta, b.exponent - 1.0, per_size])
    return np.array(rows, dtype=float).reshape(-1, 12)


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
    sizes = {"states": n, "actuators": nu, "outputs": ny, "elements": nb, "operators": len(mirror.operators)}
    plant = kernels.Plant(
        step_s=float(step_s),
        **kernels.counts(sizes == kernels.UNROLLED, **sizes),
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
        bouc_wen=kernel_rows(mirror.bouc_wen),
        operator=np.array(
            [(o.widening, o.rate_limit, *o.polynomial, o.reach) for o in mirror.operators], dtype=float
        ).reshape(-1, 6),
        play_start=np.cumsum([0, *(len(o.thresholds) for o in mirror.operators)]).astype(np.uint64),
        play_threshold=np.array([r for o in mirror.operators for r in o.thresholds], dtype=float),
        play_weight=np.array([w for o in mirror.operators for w in o.weights], dtype=float),
    )
    state = kernels.PlantState(
        x=np.zeros(even),
        x_next=np.zeros(even),
        u=np.zeros(nu),
        u_next=np.zeros(nu),
        y=np.zeros(ny),
        bank=np.zeros((nz, 4)),
        play=np.zeros(plant.play_threshold.size),
        clamped=np.zeros(nz, dtype=np.int64),
    )
    return plant, state


def build_loop(loop, step_s, unrolled=False):
    """The kernels' loop, and its state at rest."""
    actuators, axes = loop.allocation.shape
    controllers, elements = len(loop.Ac), len(loop.inverse_bouc_wen)
    feedforward = elements > 0 or len(loop.inverse_play_threshold) > 0 or bool(np.any(loop.inverse_direct))
    columns = (loop.command_min, loop.command_max, loop.drive_resolution, loop.amplifier_factor, loop.slew_step)
    record = kernels.Loop(
        **kernels.counts(unrolled, actuators=actuators, axes=axes, states=controllers),
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
        inverse_bouc_wen=kernel_rows(loop.inverse_bouc_wen),
        inverse_bouc_wen_actuator=np.array(loop.inverse_bouc_wen_actuator, dtype=np.uint64),
        inverse_play_threshold=np.array(loop.inverse_play_threshold, dtype=float),
        inverse_play_weight=np.array(loop.inverse_play_weight, dtype=float),
        inverse_play_actuator=np.array(loop.inverse_play_actuator, dtype=np.uint64),
        inverse_widening=np.array(loop.inverse_widening, dtype=float),
        inverse_lag_keep=np.array([exp(-step_s * loop.steps_per_sample / tau) for _, tau, _ in loop.inverse_creep]),
        inverse_lag_weight=np.array([weight for weight, _, _ in loop.inverse_creep], dtype=float),
        inverse_lag_actuator=np.array([actuator for _, _, actuator in loop.inverse_creep], dtype=np.uint64),
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
        inverse_lag=np.zeros(len(loop.inverse_creep)),
        pending=np.zeros((loop.delay_steps + 1, actuators)),
        position=np.zeros(1, dtype=np.int64),
        counts=np.zeros((actuators, 2), dtype=np.int64),
        inverse_clamped=np.zeros(elements + actuators, dtype=np.int64),
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
    record, loop_rest = build_loop(loop, step_s, isinstance(plant.states, tuple))
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
