"""One hysteresis element or creep lag, advanced exactly over a step; whole responses of one alone."""

from math import exp, expm1, log1p

import numpy as np

from microrad.core.kernels.compiler import Floats, compiled_loop, inlined, merged
from microrad.core.kernels.records import (
    ALPHA,
    BETA,
    BIAS,
    CUBIC,
    D1,
    D2,
    DELTA,
    EPSILON,
    ETA,
    GAMMA,
    PER_SIZE,
    POWER,
    QUADRATIC,
    RATE_LIMIT,
    REACH,
    SIGNED,
    WIDENING,
    WIDENING_LIMIT,
    bouc_wen_rows,
)


@inlined
def near_exp(x):  # type: ignore[no-untyped-def]
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


@inlined
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


@inlined
def bouc_wen_step(h, travel, epsilon_rate, alpha, beta, gamma, eta):  # type: ignore[no-untyped-def]
    """Exact h after a drive that moves by ``travel`` at constant rate; ``epsilon_rate`` = epsilon exp(delta |rate|).

    h' = epsilon_rate q' - alpha |q'| h - beta q' |h| - gamma |q'| |h| - eta q' h  is linear in h on each side of zero,
    with forcing F and decay k: h <- h exp(-k) + F (1 - exp(-k)) / k. It crosses zero at most once, at the fraction
    ln(1 - k h / F) / k of the step. gamma = eta = 0 is Eq. 3.

    Args:
        h: Hysteresis at the begin of the step, in the unit of the output.
        travel: Change of the drive over the step, with its sign.
        epsilon_rate: Output per drive; the rate is that of the drive over the step.
        alpha: Decay per travel, whichever way (Eq. 3), in 1 / V where the drive is in V, as are the next three.
        beta: Decay that turns its sign with the travel and with the side of h (Eq. 3).
        gamma: Decay that turns its sign with the side of h.
        eta: Decay that turns its sign with the travel.
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


@inlined
def _power_slope(h, forcing, positive, negative, power, per_size):  # type: ignore[no-untyped-def]
    return forcing - (positive if h > 0.0 else negative) * h * (abs(h) * per_size) ** power


@compiled_loop
def bouc_wen_power_step(h, travel, epsilon_rate, rows, e):  # type: ignore[no-untyped-def]
    """h after a drive that moves by ``travel`` at constant rate, for an exponent n other than 1.

    As `bouc_wen_step` with each |h| of the decay times (|h| / size)^(n - 1); n - 1 and 1 / size are the columns POWER
    and PER_SIZE of row ``e``. Runge-Kutta of order 5 with the embedded order 4 (Dormand and Prince, J. Comp. Appl.
    Math. 6 (1980) 19) to an error of 1e-11 of the size a step of its own, in at most a million steps. What is no finite
    number, or grows beyond all bounds on the way, comes out as nan.

    Args:
        h: Hysteresis at the begin of the step, in the unit of the output.
        travel: Change of the drive over the step, with its sign.
        epsilon_rate: epsilon exp(delta |rate|), output per drive.
        rows: Bouc-Wen parameters, shape (elements, columns), see `bouc_wen_rows`.
        e: Row of the element.
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


@merged
def bouc_wen_advance(h, travel, rate, rows, e):  # type: ignore[no-untyped-def]
    """h of Bouc-Wen element e after its drive has moved by ``travel``.

    Args:
        h: Hysteresis at the begin of the step, in the unit of the output.
        travel: Change of the drive over the step, with its sign.
        rate: Rate of the drive, per second, already held within RATE_LIMIT.
        rows: Bouc-Wen parameters, shape (elements, columns), see `bouc_wen_rows`.
        e: Row of the element.
    """
    grown = rows[e, EPSILON] * near_exp(rows[e, DELTA] * abs(rate))
    if rows[e, POWER] != 0.0:
        return bouc_wen_power_step(h, travel, grown, rows, e)
    return bouc_wen_step(h, travel, grown, rows[e, ALPHA], rows[e, BETA], rows[e, GAMMA], rows[e, ETA])


@inlined
def clamp(value, limit):  # type: ignore[no-untyped-def]
    """The value within -limit and limit.

    Args:
        value: A number.
        limit: The largest magnitude, not negative, in the same unit.
    """
    return limit if value > limit else (-limit if value < -limit else value)


@inlined
def widened(threshold, widening):  # type: ignore[no-untyped-def]
    """The threshold of a play at a rate; one without a threshold has none at any.

    Args:
        threshold: Threshold r at rest, half the width of the play, not negative, in the unit of the drive.
        widening: What the rate adds to it, in the same unit.
    """
    return threshold + widening if threshold > 0.0 else 0.0


@inlined
def play_step(p, q, threshold):  # type: ignore[no-untyped-def]
    """A play operator's state behind the drive q.

    Args:
        p: State before, in the unit of the drive.
        q: Drive at the end of the step.
        threshold: Half the width of the play, not negative, in the unit of the drive.
    """
    return max(q - threshold, min(q + threshold, p))


@inlined
def polynomial(operator, o, q):  # type: ignore[no-untyped-def]
    """What an operator adds to its plays: quadratic s^2 + signed |s| s + cubic s^3, s = q / reach within -1 and 1.

    Args:
        operator: Row of each Prandtl-Ishlinskii operator; its reach is infinite where it has no polynomial.
        o: Number of the operator, from 0.
        q: Drive at the end of the step.
    """
    s = clamp(q, operator[o, REACH]) / operator[o, REACH]
    return s * (operator[o, QUADRATIC] * s + operator[o, SIGNED] * abs(s) + operator[o, CUBIC] * (s * s))


@inlined
def row_product(matrix, i, w):  # type: ignore[no-untyped-def]
    """Row i of the matrix times the vector w.

    Args:
        matrix: `Rows` of a matrix.
        i: Number of the row, from 0.
        w: Vector, at least as long as the matrix is wide.
    """
    total = 0.0
    for j in range(matrix.start[i], matrix.start[i + 1]):
        total += matrix.value[j] * w[matrix.column[j]]
    return total


@compiled_loop
def bouc_wen_kernel(drive, step_s, rows, hysteresis0, output, hysteresis):  # type: ignore[no-untyped-def]
    """Static Eq. 3 for a sampled drive, linear between samples; fills ``output`` and ``hysteresis``.

    Returns the number of rate-clamped samples. The rate is the backward difference, zero at the first sample.

    Args:
        drive: Drive about its bias, V, shape (samples,), at least one.
        step_s: Time between samples, s.
        rows: Parameters, shape (1, columns), see `bouc_wen_rows`.
        hysteresis0: h before the first sample, in the unit of the output.
        output: Output about that at rest, shape (samples,); written.
        hysteresis: h, its share of the output, shape (samples,); written.
    """
    h = hysteresis0
    clamped, row = 0, np.int64(0)  # no literal: it would compile what it calls once more
    previous = drive[0]
    for k in range(drive.size):
        travel = drive[k] - previous
        rate = travel / step_s
        if abs(rate) > rows[0, RATE_LIMIT]:
            clamped += 1
            rate = clamp(rate, rows[0, RATE_LIMIT])
        h = bouc_wen_advance(h, travel, rate, rows, row)
        linear = rows[0, D1] * near_exp(-rows[0, D2] * rate) * (drive[k] + rows[0, BIAS])
        output[k] = linear - rows[0, D1] * rows[0, BIAS] + h
        hysteresis[k] = h
        previous = drive[k]
    return clamped


def bouc_wen_response(
    drive: Floats, step_s: float, parameters: Floats, hysteresis0: float
) -> tuple[Floats, Floats, int]:
    """Static Eq. 3 for a sampled drive: (output, hysteresis, number of rate-clamped samples), see bouc_wen_kernel.

    Args:
        drive: Drive about its bias, V, shape (samples,), at least one.
        step_s: Time between samples, s.
        parameters: A row of `bouc_wen_rows`, which may end early, as there.
        hysteresis0: h before the first sample, in the unit of the output.
    """
    output, hysteresis = np.empty(drive.size), np.empty(drive.size)
    clamped = bouc_wen_kernel(drive, step_s, bouc_wen_rows([parameters.tolist()]), hysteresis0, output, hysteresis)
    return output, hysteresis, int(clamped)


@compiled_loop
def play_kernel(drive, step_s, thresholds, operator, state0, states):  # type: ignore[no-untyped-def]
    """States of play operators, p <- max(u - r, min(u + r, p)); fills ``states``.

    A threshold above 0 grows with the rate, r + WIDENING |u'|. Returns the number of rate-clamped samples.

    Args:
        drive: Drive u, V, shape (samples,), at least one.
        step_s: Time between samples, s.
        thresholds: Thresholds r at rest, V, not negative, shape (operators,).
        operator: WIDENING (s) and WIDENING_LIMIT (V/s), the rate beyond which it grows no further, shape (2,).
        state0: States before the first sample, V, shape (operators,).
        states: States at each sample, V, shape (samples, operators); written.
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
            p = play_step(p, drive[k], widened(thresholds[j], operator[WIDENING] * rate))
            states[k, j] = p
            previous = drive[k]
    return clamped


def play_response(drive: Floats, thresholds: Floats, state0: Floats) -> Floats:
    """States of play operators that do not depend on the rate, shape (samples, operators), see play_kernel.

    Args:
        drive: Drive, V, shape (samples,), at least one.
        thresholds: Thresholds, V, not negative, shape (operators,).
        state0: States before the first sample, V, shape (operators,).
    """
    return widening_play_response(drive, 1.0, thresholds, np.array([0.0, np.inf]), state0)[0]


def widening_play_response(
    drive: Floats, step_s: float, thresholds: Floats, operator: Floats, state0: Floats
) -> tuple[Floats, int]:
    """States of play operators, shape (samples, operators), and the number of rate-clamped samples, see play_kernel.

    Args:
        drive: Drive, V, shape (samples,), at least one.
        step_s: Time between samples, s.
        thresholds: Thresholds at rest, V, not negative, shape (operators,).
        operator: WIDENING (s) and WIDENING_LIMIT (V/s), shape (2,).
        state0: States before the first sample, V, shape (operators,).
    """
    states = np.empty((drive.size, thresholds.size))
    clamped = play_kernel(drive, step_s, thresholds, operator, state0, states)
    return states, int(clamped)


@compiled_loop
def lag_kernel(drive, step_s, time_constants, state0, states):  # type: ignore[no-untyped-def]
    """First-order lags x' = (u - x) / tau of a drive linear between samples; fills ``states``.

    Args:
        drive: Drive u, V, shape (samples,), at least one.
        step_s: Time between samples, s.
        time_constants: tau of each lag, s, above 0, shape (lags,).
        state0: States at the first sample, V, shape (lags,).
        states: States at each sample, V, shape (samples, lags); written.
    """
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
    """States of first-order lags, shape (samples, lags), from ``state0`` at the first sample, see lag_kernel.

    Args:
        drive: Drive, V, shape (samples,), at least one.
        step_s: Time between samples, s.
        time_constants: Time constant of each lag, s, above 0, shape (lags,).
        state0: States at the first sample, V, shape (lags,).
    """
    states = np.empty((drive.size, time_constants.size))
    lag_kernel(drive, step_s, time_constants, state0, states)
    return states
