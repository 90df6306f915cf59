"""The compiled loops: hysteresis, mirror and sampled closed loop, advanced sample by sample.

Arrays, floats and named tuples in, arrays out; no checks, no units, no input or output. This is the only file that
imports numba, and it stays one file: the machine-code cache of one file does not see an edit in another.
Every kernel has a slow, obvious twin in ``tests/oracles.py`` and runs unchanged under ``NUMBA_DISABLE_JIT=1``.

All quantities are deviations from the operating point (drive bias, output at rest), so zero states are at rest.
"""

from collections.abc import Callable, Sequence
from hashlib import sha256
from math import exp, expm1, log1p
from typing import Any, NamedTuple

import numba
import numpy as np
from numba.core.caching import IndexDataCacheFile
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
_inline: Callable[[Any], Any] = numba.njit(inline="always", **_OPTIONS)


class _CacheFile(IndexDataCacheFile):
    """Machine code in files named by what they hold, written before the index names them.

    Numba counts its files: two processes that compile at once write different code under one number, and a later one
    loads the wrong one (seen: an IndexError in half the runs behind a cold parallel start).
    """

    def save(self, key: Any, data: Any) -> None:
        name = f"{self._index_name.removesuffix('.nbi')}.{sha256(repr(key).encode()).hexdigest()[:16]}.nbc"
        self._save_data(name, data)  # type: ignore[no-untyped-call]
        self._save_index({**self._load_index(), key: name})  # type: ignore[no-untyped-call]


def _compile(function: Callable[..., Any]) -> Any:
    """The function compiled, with its machine code kept in a cache that several processes may share."""
    compiled = numba.njit(**_OPTIONS)(function)
    if cache := getattr(compiled, "_cache", None):  # none under NUMBA_DISABLE_JIT
        cache._cache_file.__class__ = _CacheFile
    return compiled

# Columns of a Bouc-Wen parameter row: Eq. 3 of SPIE 11852, 118523B, then the asymmetry between the signs of h and
# between rising and falling drive, the exponent less 1, and 1 / size of h at which the exponent has no effect.
D1, D2, EPSILON, DELTA, ALPHA, BETA, RATE_LIMIT, BIAS, GAMMA, ETA, POWER, PER_SIZE = range(12)

# Columns of a Prandtl-Ishlinskii operator's row: growth of its thresholds with the rate, and the rate where that ends.
WIDENING, WIDENING_LIMIT = range(2)

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

    The inverse, see `_inverse`: ``inverse_bouc_wen`` and ``inverse_play_*`` belong to one actuator each, as do the lags
    of creep, which keep ``inverse_lag_keep`` of themselves over a sample. ``inverse_widening`` (actuators; WIDENING in
    s, WIDENING_LIMIT in output units per second) is the growth of the inverse thresholds with the target's rate.
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
def bouc_wen_step(h, travel, epsilon_rate, alpha, beta, gamma, eta):  # type: ignore[no-untyped-def]
    """Exact h after a drive that moves by ``travel`` at constant rate; ``epsilon_rate`` = epsilon exp(delta |rate|).

    h' = epsilon_rate q' - alpha |q'| h - beta q' |h| - gamma |q'| |h| - eta q' h  is linear in h on each side of zero,
    with forcing F and decay k: h <- h exp(-k) + F (1 - exp(-k)) / k. It crosses zero at most once, at the fraction
    ln(1 - k h / F) / k of the step. gamma = eta = 0 is Eq. 3.
    """
    forcing = epsilon_rate * travel
    side = 1.0 if h > 0.0 or (h == 0.0 and forcing > 0.0) else -1.0
    decay = (alpha + side * gamma) * abs(travel) + (side * beta + eta) * travel
    end = _relaxed(h, forcing, decay)
    if h * forcing >= 0.0 or h * end > 0.0:
        return end
    # The sign changes inside the step: reach zero, then leave it on the other side with that side's decay.
    fraction = -h / forcing if decay == 0.0 else log1p(-decay * h / forcing) / decay
    rest = max(0.0, 1.0 - fraction)
    other = (alpha - side * gamma) * abs(travel) + (eta - side * beta) * travel
    return _relaxed(0.0, forcing * rest, other * rest)


@_inline
def _power_slope(h, forcing, positive, negative, power, per_size):  # type: ignore[no-untyped-def]
    return forcing - (positive if h > 0.0 else negative) * h * (abs(h) * per_size) ** power


@_compile
def bouc_wen_power_step(h, travel, epsilon_rate, rows, e):  # type: ignore[no-untyped-def]
    """h after a drive that moves by ``travel`` at constant rate, for an exponent n other than 1.

    As `bouc_wen_step` with each |h| of the decay times (|h| / size)^(n - 1); n - 1 and 1 / size are the columns POWER
    and PER_SIZE of row ``e``. Runge-Kutta of order 5 with the embedded order 4 (Dormand and Prince, J. Comp. Appl.
    Math. 6 (1980) 19) to an error of 1e-11 of the size a step of its own, in at most a million steps. What is no finite
    number, or grows beyond all bounds on the way, comes out as nan.
    """
    power, per_size = rows[e, POWER], rows[e, PER_SIZE]
    forcing = epsilon_rate * travel
    positive = (rows[e, ALPHA] + rows[e, GAMMA]) * abs(travel) + (rows[e, BETA] + rows[e, ETA]) * travel
    negative = (rows[e, ALPHA] - rows[e, GAMMA]) * abs(travel) + (rows[e, ETA] - rows[e, BETA]) * travel
    done, step = 0.0, 1.0 / (1.0 + max(abs(positive), abs(negative)) * (power + 1.0) * max(1.0, abs(h) * per_size))
    if not (h - h == 0.0 and forcing - forcing == 0.0 and positive + negative < 1e300):
        return np.nan
    for _ in range(1_000_000):
        if done >= 1.0:
            return h
        step = min(step, 1.0 - done)
        k1 = _power_slope(h, forcing, positive, negative, power, per_size)
        k2 = _power_slope(h + step * k1 / 5.0, forcing, positive, negative, power, per_size)
        k3 = _power_slope(h + step * (3.0 * k1 + 9.0 * k2) / 40.0, forcing, positive, negative, power, per_size)
        at = h + step * (44.0 / 45.0 * k1 - 56.0 / 15.0 * k2 + 32.0 / 9.0 * k3)
        k4 = _power_slope(at, forcing, positive, negative, power, per_size)
        at = 19372.0 / 6561.0 * k1 - 25360.0 / 2187.0 * k2 + 64448.0 / 6561.0 * k3 - 212.0 / 729.0 * k4
        k5 = _power_slope(h + step * at, forcing, positive, negative, power, per_size)
        at = 9017.0 / 3168.0 * k1 - 355.0 / 33.0 * k2 + 46732.0 / 5247.0 * k3 + 49.0 / 176.0 * k4
        k6 = _power_slope(h + step * (at - 5103.0 / 18656.0 * k5), forcing, positive, negative, power, per_size)
        move = 35.0 / 384.0 * k1 + 500.0 / 1113.0 * k3 + 125.0 / 192.0 * k4 - 2187.0 / 6784.0 * k5 + 11.0 / 84.0 * k6
        end = h + step * move
        k7 = _power_slope(end, forcing, positive, negative, power, per_size)
        error = 71.0 / 57600.0 * k1 - 71.0 / 16695.0 * k3 + 71.0 / 1920.0 * k4 - 17253.0 / 339200.0 * k5
        error = abs(step * (error + 22.0 / 525.0 * k6 - k7 / 40.0)) * per_size * 1e11
        if error <= 1.0:
            done += step
            h = end
        step *= min(5.0, max(0.2, 0.9 * (error + 1e-12) ** -0.2)) if error < 1e300 else 0.2
    return np.nan


@_inline
def _bouc_wen_advance(h, travel, rate, rows, e):  # type: ignore[no-untyped-def]
    """h of Bouc-Wen element e after its drive has moved by ``travel``; the rate is the clamped one."""
    grown = rows[e, EPSILON] * _near_exp(rows[e, DELTA] * abs(rate))
    if rows[e, POWER] != 0.0:
        return bouc_wen_power_step(h, travel, grown, rows, e)
    return bouc_wen_step(h, travel, grown, rows[e, ALPHA], rows[e, BETA], rows[e, GAMMA], rows[e, ETA])


@_inline
def _clamp(value, limit):  # type: ignore[no-untyped-def]
    return limit if value > limit else (-limit if value < -limit else value)


@_inline
def _widened(threshold, widening):  # type: ignore[no-untyped-def]
    return threshold + widening if threshold > 0.0 else 0.0


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
def bouc_wen_kernel(drive, step_s, rows, hysteresis0, output, hysteresis):  # type: ignore[no-untyped-def]
    """Static Eq. 3 (one row) for a sampled drive, linear between samples; fills ``output`` and ``hysteresis``.

    Returns the number of rate-clamped samples. The rate is the backward difference, zero at the first sample.
    """
    h = hysteresis0
    clamped = 0
    previous = drive[0]
    for k in range(drive.size):
        travel = drive[k] - previous
        rate = travel / step_s
        if abs(rate) > rows[0, RATE_LIMIT]:
            clamped += 1
            rate = _clamp(rate, rows[0, RATE_LIMIT])
        h = _bouc_wen_advance(h, travel, rate, rows, 0)
        linear = rows[0, D1] * _near_exp(-rows[0, D2] * rate) * (drive[k] + rows[0, BIAS])
        output[k] = linear - rows[0, D1] * rows[0, BIAS] + h
        hysteresis[k] = h
        previous = drive[k]
    return clamped


def bouc_wen_response(
    drive: Floats, step_s: float, parameters: Floats, hysteresis0: float
) -> tuple[Floats, Floats, int]:
    """Static Eq. 3 for a sampled drive: (output, hysteresis, number of rate-clamped samples).

    See bouc_wen_kernel; ``parameters`` is a row of `bouc_wen_rows`.
    """
    output, hysteresis = np.empty(drive.size), np.empty(drive.size)
    clamped = bouc_wen_kernel(drive, step_s, bouc_wen_rows([parameters.tolist()]), hysteresis0, output, hysteresis)
    return output, hysteresis, int(clamped)


@_compile
def play_kernel(drive, step_s, thresholds, operator, state0, states):  # type: ignore[no-untyped-def]
    """States of play operators, p <- max(u - r, min(u + r, p)); fills ``states`` (samples, operators).

    A threshold above 0 grows with the rate, r + WIDENING |u'|; ``operator`` is one row. Returns the clamped samples.
    """
    clamped = 0
    for j in range(thresholds.size):
        p = state0[j]
        previous = drive[0]
        clamped = 0
        for k in range(drive.size):
            rate = abs(drive[k] - previous) / step_s
            if rate > operator[WIDENING_LIMIT]:
                clamped += 1
                rate = operator[WIDENING_LIMIT]
            p = _play(p, drive[k], _widened(thresholds[j], operator[WIDENING] * rate))
            states[k, j] = p
            previous = drive[k]
    return clamped


def play_response(drive: Floats, thresholds: Floats, state0: Floats) -> Floats:
    """States of play operators that do not depend on the rate, shape (samples, operators), see play_kernel."""
    return widening_play_response(drive, 1.0, thresholds, np.array([0.0, np.inf]), state0)[0]


def widening_play_response(
    drive: Floats, step_s: float, thresholds: Floats, operator: Floats, state0: Floats
) -> tuple[Floats, int]:
    """States of play operators, shape (samples, operators), and the number of rate-clamped samples, see play_kernel."""
    states = np.empty((drive.size, thresholds.size))
    clamped = play_kernel(drive, step_s, thresholds, operator, state0, states)
    return states, int(clamped)


@_compile
def lag_kernel(drive, step_s, time_constants, state0, states):  # type: ignore[no-untyped-def]
    """First-order lags x' = (u - x) / tau of a drive linear between samples; fills ``states`` (samples, lags)."""
    for j in range(time_constants.size):
        part = step_s / time_constants[j]
        gain = -expm1(-part)
        keep = 1.0 - gain
        ramp = 1.0 - gain / part  # what the drive's end adds; the rest comes from its begin
        if part < 0.02:  # its series, where the difference would cancel
            ramp = part * (1.0 / 2.0 - part * (1.0 / 6.0 - part * (1.0 / 24.0 - part * (1.0 / 120.0 - part / 720.0))))
        x = state0[j]
        states[0, j] = x
        for k in range(1, drive.size):
            x = keep * x + (gain - ramp) * drive[k - 1] + ramp * drive[k]
            states[k, j] = x


def lag_response(drive: Floats, step_s: float, time_constants: Floats, state0: Floats) -> Floats:
    """States of first-order lags, shape (samples, lags), from ``state0`` at the first sample, see lag_kernel."""
    states = np.empty((drive.size, time_constants.size))
    lag_kernel(drive, step_s, time_constants, state0, states)
    return states


@_inline
def _predict(plant, state):  # type: ignore[no-untyped-def]
    """The part of the predicted x that needs nothing from the end of the step."""
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
    h = _bouc_wen_advance(state.bank[e, H], travel, rate, row, e)
    state.bank[e, H] = h
    state.bank[e, Q] = q
    return row[e, D1] * (_near_exp(-row[e, D2] * rate) * (q + row[e, BIAS]) - row[e, BIAS]) + h


@_inline
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
        p = _play(state.play[j], q, _widened(plant.play_threshold[j], widening))
        state.play[j] = p
        total += plant.play_weight[j] * p
    state.bank[e, Q] = q
    return total


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
    play_start: Integers
    play_threshold: NDArray[Any]
    play_weight: NDArray[Any]


class Path(NamedTuple):
    """What a `PlayPlant` went through, one row a step: `play_path` fills it, `tangent_kernel` runs along it.

    ``x`` is the predicted state (see `Plant`), ``state`` the one with the change of z in it, ``z`` and ``play`` the
    outputs and the plays of the operators. ``moved`` counts for each operator the plays that its drive carries along:
    always the first ones, for the memories of an operator that began at rest are nested.
    """

    output: Floats
    x: Floats
    state: Floats
    z: Floats
    play: Floats
    moved: Integers


@_compile
def play_path(plant, drive, path):  # type: ignore[no-untyped-def]
    """`open_loop` from rest with the whole path kept; the same arithmetic, see `Plant`, in loops of any length."""
    states, inputs, operators = plant.diagonal.size, drive.shape[1], path.z.shape[1]
    for k in range(drive.shape[0]):
        for i in range(states):
            total = 0.0
            for a in range(inputs):
                total += plant.B1[i, a] * drive[k, a]
            if k > 0:
                total += plant.diagonal[i] * path.state[k - 1, i] + plant.coupling[i] * path.state[k - 1, i ^ 1]
                for a in range(inputs):
                    total += plant.B0[i, a] * drive[k - 1, a]
                for e in range(operators):
                    total += plant.E_held[i, e] * path.z[k - 1, e]
            path.x[k, i] = total
        for e in range(operators):
            q = 0.0
            for a in range(inputs):
                q += plant.G[e, a] * drive[k, a]
            for i in range(states):
                q += plant.F[e, i] * path.x[k, i]
            total, count = 0.0, 0
            for j in range(plant.play_start[e], plant.play_start[e + 1]):
                threshold = plant.play_threshold[j]
                p = _play(path.play[k - 1, j] if k > 0 else 0.0, q, threshold)
                path.play[k, j] = p
                total += plant.play_weight[j] * p
                if p == q - threshold or p == q + threshold:
                    count += 1
            path.z[k, e] = total
            path.moved[k, e] = count
        for i in range(states):
            total = path.x[k, i]
            for e in range(operators):
                total += plant.E1[i, e] * (path.z[k, e] - (path.z[k - 1, e] if k > 0 else 0.0))
            path.state[k, i] = total
        for o in range(path.output.shape[1]):
            total = 0.0
            for i in range(states):
                total += plant.C[o, i] * path.state[k, i]
            for a in range(inputs):
                total += plant.D[o, a] * drive[k, a]
            for e in range(operators):
                total += plant.K[o, e] * path.z[k, e]
            path.output[k, o] = total


DRIVE_FROM, BANK_FROM = range(2)  # of a parameter's place


class Tangents(NamedTuple):
    """Parameters, where each enters a `PlayPlant` along a `Path`, and the working memory of their tangents.

    The first ``places[DRIVE_FROM]`` parameters enter the state: row ``source`` of ``before`` adds to the predicted
    state, and of ``after`` to the state once the operators have moved. Both have the shape (steps, sources, 2), for the
    state ``row`` and its neighbour; with ``turned`` the pair (a, b) is (-b, a). Those up to ``places[BANK_FROM]`` enter
    the drive of operator ``row``, by column ``source`` of ``signal`` (steps, columns), and the others its output, by
    column ``source`` of ``plays``.

    The plant, the signals and the working memory share one precision; single precision is twice as fast, and enough for
    a search. The working memory has the tangents of all parameters in a row, and rows by state, operator or play; it is
    zero at the begin of a path.
    """

    plant: PlayPlant
    places: Integers
    row: Integers
    source: Integers
    turned: Integers
    before: NDArray[Any]
    after: NDArray[Any]
    signal: NDArray[Any]
    plays: NDArray[Any]
    x: NDArray[Any]
    q: NDArray[Any]
    q_before: NDArray[Any]
    z: NDArray[Any]
    change: NDArray[Any]
    play: NDArray[Any]
    still: NDArray[Any]
    slope: NDArray[Any]
    moved: Integers


@_inline
def _add(total, gain, row):  # type: ignore[no-untyped-def]
    """total += gain row. Rows are taken out of their matrices before the loop: only then is it vectorised."""
    for p in range(total.size):
        total[p] += gain * row[p]


@_inline
def _inject(t, signals, k):  # type: ignore[no-untyped-def]
    """Add what the parameters of the state contribute by themselves at step k."""
    for p in range(t.places[DRIVE_FROM]):
        i, s = t.row[p], t.source[p]
        if t.turned[p] == 1:
            t.x[i, p] -= signals[k, s, 1]
            t.x[i + 1, p] += signals[k, s, 0]
        else:
            t.x[i, p] += signals[k, s, 0]
            if signals[k, s, 1] != 0.0:  # a real pole has no neighbour
                t.x[i + 1, p] += signals[k, s, 1]


@_inline
def _tangent_predict(t):  # type: ignore[no-untyped-def]
    for i in range(0, t.x.shape[0], 2):
        keep0, keep1, cross0, cross1 = (
            t.plant.diagonal[i],
            t.plant.diagonal[i + 1],
            t.plant.coupling[i],
            t.plant.coupling[i + 1],
        )
        x0, x1 = t.x[i], t.x[i + 1]
        for p in range(x0.size):
            a, b = x0[p], x1[p]
            x0[p] = keep0 * a + cross0 * b
            x1[p] = keep1 * b + cross1 * a
    for i in range(t.x.shape[0]):
        for e in range(t.z.shape[0]):
            _add(t.x[i], t.plant.E_held[i, e], t.z[e])


@_inline
def _tangent_drive(t, k):  # type: ignore[no-untyped-def]
    for e in range(t.q.shape[0]):
        q, q_before = t.q[e], t.q_before[e]
        for p in range(q.size):
            q_before[p] = q[p]
            q[p] = 0.0
        for i in range(t.x.shape[0]):
            _add(q, t.plant.F[e, i], t.x[i])
    for p in range(t.places[DRIVE_FROM], t.places[BANK_FROM]):
        t.q[t.row[p], p] += t.signal[k, t.source[p]]


@_inline
def _regroup(t, e, now):  # type: ignore[no-untyped-def]
    """The first ``now`` plays of operator e move from here on: those that stop keep the drive's last tangent."""
    begin, end = t.plant.play_start[e], t.plant.play_start[e + 1]
    still, q_before = t.still[e], t.q_before[e]
    for j in range(begin + now, begin + t.moved[e]):
        play = t.play[j]
        for p in range(play.size):
            play[p] = q_before[p]
    for p in range(still.size):
        still[p] = 0.0
    for j in range(begin + now, end):
        _add(still, t.plant.play_weight[j], t.play[j])
    t.slope[e] = 0.0
    for j in range(begin, begin + now):
        t.slope[e] += t.plant.play_weight[j]
    t.moved[e] = now


@_inline
def _tangent_bank(t, moved, k):  # type: ignore[no-untyped-def]
    """Plays that move follow the tangent of the drive; the others keep theirs, and their sum is kept too."""
    for e in range(t.q.shape[0]):
        if moved[k, e] != t.moved[e]:
            _regroup(t, e, moved[k, e])
        slope, z, change, still, q = t.slope[e], t.z[e], t.change[e], t.still[e], t.q[e]
        for p in range(z.size):
            now = still[p] + slope * q[p]
            change[p] = now - z[p]
            z[p] = now
    # What a weight adds by itself is in z and its change now, and is taken off both before the next step's sum.
    for p in range(t.places[BANK_FROM], t.row.size):
        value = t.plays[k, t.source[p]]
        t.z[t.row[p], p] += value
        t.change[t.row[p], p] += value


@_compile
def tangent_kernel(t, moved, begin, first, stride, output):  # type: ignore[no-untyped-def]
    """Derivative of a plant's output by parameters, along its path (forward sensitivities of the plays' exact steps).

    Starts with no tangent at step ``begin``, runs to the end of the path, whose ``moved`` is given, and fills
    ``output`` (rows, outputs, parameters) from step ``first`` on, every ``stride`` steps. What enters the output itself
    (C, D, K) is not a parameter here.
    """
    row = 0
    for k in range(begin, moved.shape[0]):
        _tangent_predict(t)
        _inject(t, t.before, k)
        _tangent_drive(t, k)
        _tangent_bank(t, moved, k)
        for i in range(t.x.shape[0]):
            for e in range(t.z.shape[0]):
                _add(t.x[i], t.plant.E1[i, e], t.change[e])
        _inject(t, t.after, k)
        if k >= first and (k - first) % stride == 0:
            for o in range(output.shape[1]):
                total = output[row, o]
                for p in range(total.size):
                    total[p] = 0.0
                for i in range(t.x.shape[0]):
                    _add(total, t.plant.C[o, i], t.x[i])
                for e in range(t.z.shape[0]):
                    _add(total, t.plant.K[o, e], t.z[e])
            row += 1


@_compile
def _inverse(loop, state, reference, sample_s, feedforward):  # type: ignore[no-untyped-def]
    """Causal inverse-multiplicative feedforward (Eq. 4), and the closed-form inverse of play operators.

    u = (r - h + d1 bias) / (d1 exp(-d2 q')) - bias, with h and q' driven by the reference, q = r / d1: taking the rate
    from the feedforward's own last sample makes it chatter at the sample rate. What creep will add is taken off the
    reference first: it lags, so it is known from the samples before. The inverse needs nothing from the loop, so it
    runs ahead of it, over all of ``reference``, into ``feedforward`` (samples, actuators).
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
        for e in range(len(loop.inverse_elements)):
            row, a = loop.inverse_bouc_wen, loop.inverse_bouc_wen_actuator[e]
            travel = (state.target[a, NOW] - state.target[a, BEFORE]) / row[e, D1]
            rate = travel / sample_s
            if abs(rate) > row[e, RATE_LIMIT]:
                state.inverse_clamped[e] += 1
                rate = _clamp(rate, row[e, RATE_LIMIT])
            h = _bouc_wen_advance(state.inverse_h[e], travel, rate, row, e)
            state.inverse_h[e] = h
            gain = row[e, D1] * _near_exp(-row[e, D2] * rate)
            feedforward[k, a] += (state.target[a, NOW] - h + row[e, D1] * row[e, BIAS]) / gain - row[e, BIAS]
        for a in range(len(loop.actuators)):
            widening = 0.0
            if loop.inverse_widening[a, WIDENING] != 0.0:
                rate = abs(state.target[a, NOW] - state.target[a, BEFORE]) / sample_s
                if rate > loop.inverse_widening[a, WIDENING_LIMIT]:
                    state.inverse_clamped[len(loop.inverse_elements) + a] += 1
                    rate = loop.inverse_widening[a, WIDENING_LIMIT]
                widening = loop.inverse_widening[a, WIDENING] * rate
            for e in range(loop.inverse_play_actuator.size):
                if loop.inverse_play_actuator[e] == a:
                    threshold = _widened(loop.inverse_play_threshold[e], widening)
                    p = _play(state.inverse_p[e], state.target[a, NOW], threshold)
                    state.inverse_p[e] = p
                    feedforward[k, a] += loop.inverse_play_weight[e] * p
        for j in range(loop.inverse_lag_keep.size):
            keep = loop.inverse_lag_keep[j]
            drive = feedforward[k, loop.inverse_lag_actuator[j]]
            state.inverse_lag[j] = keep * state.inverse_lag[j] + (1.0 - keep) * drive


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


def bouc_wen_rows(parameters: Sequence[Sequence[float]]) -> Floats:
    """Parameter rows as an array; a row that ends early (at BIAS or before) is Eq. 3, without what generalises it."""
    rows_array = np.zeros((len(parameters), PER_SIZE + 1))
    for row, values in zip(rows_array, parameters, strict=True):
        row[: len(values)] = values
    return rows_array
