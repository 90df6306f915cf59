"""The compiled loops: hysteresis, mirror and sampled closed loop, advanced sample by sample.

Arrays, floats and named tuples in, arrays out; no checks, no units, no input or output. This is the only file that
imports numba, and it stays one file: the machine-code cache of one file does not see an edit in another.
Every kernel has a slow, obvious twin in ``tests/oracles.py`` and runs unchanged under ``NUMBA_DISABLE_JIT=1``.

All quantities are deviations from the operating point (drive bias, output at rest), so zero states are at rest.
"""

from collections.abc import Callable, Sequence
from hashlib import sha256
from math import exp, expm1, log1p
from typing import Any, NamedTuple, TypeVar

import numba
import numpy as np
from numba.core import config, event, types
from numba.core.caching import IndexDataCacheFile
from numba.core.codegen import get_host_cpu_features
from numba.extending import intrinsic
from numpy.typing import NDArray

from microrad.core import compiling

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
    "no_cfunc_wrapper": True,
}
_inline: Callable[[Any], Any] = numba.njit(inline="always", **_OPTIONS)

# The compiler uses half of a vector of 512 bits, which slowed the first processors that had them; those since Ice Lake
# and Zen 4, which have VBMI2, too, gain by the whole. Many runs side by side: 0.33 of the C twin, 0.39 with half of it.
_numba: Any = config
_features: str = get_host_cpu_features()  # type: ignore[no-untyped-call]
if _numba.CPU_NAME is None and _numba.CPU_FEATURES is None and "+avx512vbmi2" in _features:
    _numba.CPU_FEATURES = f"{_features},-prefer-256-bit"


class _Compiling(event.Listener):
    """Says that a loop is compiled; what is loaded from the cache is none."""

    def on_start(self, event: Any) -> None:
        compiling.begins()

    def on_end(self, event: Any) -> None:
        pass


event.register("numba:compile", _Compiling())  # type: ignore[no-untyped-call]


class _CacheFile(IndexDataCacheFile):
    """Machine code in files named by what they hold, written before the index names them.

    Numba counts its files: two processes that compile at once write different code under one number, and a later one
    loads the wrong one (seen: an IndexError in half the runs behind a cold parallel start).
    """

    def save(self, key: Any, data: Any) -> None:
        name = f"{self._index_name.removesuffix('.nbi')}.{sha256(repr(key).encode()).hexdigest()[:16]}.nbc"
        self._save_data(name, data)  # type: ignore[no-untyped-call]
        self._save_index({**self._load_index(), key: name})  # type: ignore[no-untyped-call]


def _compile(function: Callable[..., Any], **options: Any) -> Any:
    """The function compiled, with its machine code kept in a cache that several processes may share."""
    compiled = numba.njit(**_OPTIONS, **options)(function)
    if cache := getattr(compiled, "_cache", None):  # none under NUMBA_DISABLE_JIT
        cache._cache_file.__class__ = _CacheFile
    return compiled


def is_compiled(loop: Any) -> bool:
    """Whether the cache holds machine code of this loop for this processor."""
    cache = getattr(loop, "_cache", None)
    if cache is None:  # under NUMBA_DISABLE_JIT
        return True
    _, *ours = cache._index_key((), loop.targetctx.codegen())  # signature, processor, code
    return any([*key[1:]] == ours for key in cache._cache_file._load_index())


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


def _merge(function: Callable[..., Any]) -> Any:
    """Compiled by itself, and merged into its caller by the machine-code compiler: quick to compile and to call.

    Not for a function of two whole records that is called at one place: their hundreds of numbers are arguments. Only
    compiled functions may call it: from Python the process would end.
    """
    return _compile(function, forceinline=True, no_cpython_wrapper=True)


# What has as many items as there are of something; the items mean nothing. The length of a tuple is part of its type:
# short loops over it are unrolled, but each new set of lengths is compiled again, for seconds. The length of an array
# is a number like any other: one compiled loop serves all sizes, at half the speed where they are small.
Count = tuple[int, ...] | Floats

UNROLLED = {"states": 5, "actuators": 1, "outputs": 1, "elements": 1, "operators": 0}  # the paper's mirror, on one axis
UNROLLED_CONTROLLER = 2  # states of a PID


def counts(unrolled: bool, **sizes: int) -> dict[str, Any]:
    """The counts of a `Plant` or a `Loop`, by field."""
    return {name: (0,) * size if unrolled else np.zeros(size) for name, size in sizes.items()}


_Record = TypeVar("_Record", bound=tuple[Any, ...])


def by_rows(record: _Record) -> _Record:
    """The named tuple with its arrays row by row in memory: any other order would compile the loops once more."""
    return type(record)(*(np.ascontiguousarray(v) if isinstance(v, np.ndarray) else v for v in record))


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


@_merge
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
    clamped, row = 0, np.int64(0)  # no literal: it would compile what it calls once more
    previous = drive[0]
    for k in range(drive.size):
        travel = drive[k] - previous
        rate = travel / step_s
        if abs(rate) > rows[0, RATE_LIMIT]:
            clamped += 1
            rate = _clamp(rate, rows[0, RATE_LIMIT])
        h = _bouc_wen_advance(h, travel, rate, rows, row)
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


@_merge
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
        for e in range(loop.inverse_bouc_wen.shape[0]):
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
                    state.inverse_clamped[loop.inverse_bouc_wen.shape[0] + a] += 1
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


# ------------------------------------------------------------------------------------------- equations by doubling
@_compile
def _product(left, right, out):  # type: ignore[no-untyped-def]
    """out = left right, row by row; out is another array than both."""
    for i in range(left.shape[0]):
        for j in range(out.shape[1]):
            out[i, j] = 0.0
        for k in range(left.shape[1]):
            weight = left[i, k]
            for j in range(out.shape[1]):
                out[i, j] += weight * right[k, j]


@_compile
def _transpose(matrix, out):  # type: ignore[no-untyped-def]
    for i in range(matrix.shape[0]):
        for j in range(matrix.shape[1]):
            out[j, i] = matrix[i, j]


@_compile
def _eliminate(matrix, right):  # type: ignore[no-untyped-def]
    """right = matrix^-1 right by Gauss with the largest pivot of each column; nothing is left in matrix."""
    n, columns = matrix.shape[0], right.shape[1]
    for k in range(n):
        best = k
        for i in range(k + 1, n):
            if abs(matrix[i, k]) > abs(matrix[best, k]):
                best = i
        if best != k:
            for j in range(k, n):
                matrix[k, j], matrix[best, j] = matrix[best, j], matrix[k, j]
            for j in range(columns):
                right[k, j], right[best, j] = right[best, j], right[k, j]
        for i in range(k + 1, n):
            share = matrix[i, k] / matrix[k, k]
            if share != 0.0:
                for j in range(k + 1, n):
                    matrix[i, j] -= share * matrix[k, j]
                for j in range(columns):
                    right[i, j] -= share * right[k, j]
    for k in range(n - 1, -1, -1):
        pivot = matrix[k, k]
        for j in range(columns):
            right[k, j] /= pivot
        for i in range(k):
            share = matrix[i, k]
            if share != 0.0:
                for j in range(columns):
                    right[i, j] -= share * right[k, j]


@_compile
def riccati_kernel(power, G, X, work, wide):  # type: ignore[no-untyped-def]
    """Doubles A, B R^-1 B' and Q into the solution X = A' X (I + G X)^-1 A + Q; whether it has settled.

    Structure-preserving doubling: Chu, Fan, Lin and Wang, International Journal of Control 77 (2004) 767. The first
    three (n, n) are written over; ``work`` (4, n, n) and ``wide`` (n, 2 n) are room.
    """
    n = X.shape[0]
    first, second, other, more = work[0], work[1], work[2], work[3]
    for _ in range(60):
        _product(G, X, other)
        for i in range(n):
            other[i, i] += 1.0
            for j in range(n):
                wide[i, j], wide[i, n + j] = power[i, j], G[i, j]
        _eliminate(other, wide)
        for i in range(n):
            for j in range(n):
                first[i, j], second[i, j] = wide[i, j], wide[i, n + j]
        _transpose(power, other)
        _product(second, other, more)  # G += power second power'
        _product(power, more, second)
        _product(X, first, more)  # X += power' X first
        _product(other, more, wide[:, :n])
        _product(power, first, other)
        largest, moving = 0.0, False
        for i in range(n):
            for j in range(n):
                power[i, j] = other[i, j]
                X[i, j] += 0.5 * (wide[i, j] + wide[j, i])
                more[i, j] = G[i, j] + second[i, j]
                largest = max(largest, abs(X[i, j]))
        for i in range(n):
            moving = moving or abs(wide[i, i]) > 1e-14 * X[i, i]
            for j in range(n):
                G[i, j] = 0.5 * (more[i, j] + more[j, i])
        if not largest < 1e150:
            return False
        if not moving:
            return True
    return False


@_compile
def gramian_kernel(power, X, work):  # type: ignore[no-untyped-def]
    """Doubles A and Q into the solution X = A' X A + Q, as `lti.gramian`; both (n, n) are written over.

    ``work`` (3, n, n) is room.
    """
    n = X.shape[0]
    turned, half, more = work[0], work[1], work[2]
    for _ in range(64):
        _transpose(power, turned)
        _product(X, power, half)
        _product(turned, half, more)
        moving = False
        for i in range(n):
            for j in range(n):
                X[i, j] += more[i, j]
            moving = moving or more[i, i] > 1e-15 * abs(X[i, i])
        if not moving:
            return
        _product(power, power, half)
        for i in range(n):
            for j in range(n):
                power[i, j] = half[i, j]


# ------------------------------------------------------------------------------------------- many runs side by side
# Runs in a row of memory: a count that the compiler knows, so that it works on several of them with one instruction.
LANES = 64

# Bins of the radial error's histogram: sixteen to an octave of its square, from 2^-66 rad^2 (0.1 nrad) to 1 rad^2.
BINS_OCTAVE_BITS = 4
BINS_LOWEST_OCTAVE = -66
BINS = -BINS_LOWEST_OCTAVE << BINS_OCTAVE_BITS
_BIN_SHIFT = np.int64(52 - BINS_OCTAVE_BITS)
_BIN_OFFSET = np.int64((1023 + BINS_LOWEST_OCTAVE) << BINS_OCTAVE_BITS)

# Fields of a bank element's rows, of an actuator's drive, and of the counters of a run.
BANK_Q, BANK_H, BANK_Z, BANK_Z_BEFORE, BANK_Q_NEXT, BANK_TRAVEL, BANK_FORCING, BANK_H_BEFORE, BANK_FIELDS = range(9)
DRIVE_BEFORE, DRIVE_NOW, DRIVE_FIELDS = range(3)
(
    COUNT_SATURATED,
    COUNT_SLEW,
    COUNT_CLAMPED,
    COUNT_INVERSE_CLAMPED,
    COUNT_OUTSIDE,
    COUNT_LOST,
    COUNT_FIELDS,
) = range(7)

# Columns of an actuator's parameters beyond those of a Loop: the drive's identified range.
DRIVE_LOW, DRIVE_HIGH = SLEW_STEP + 1, SLEW_STEP + 2

# Streams of random numbers: a disturbance's purposes lie below these; a sensor's word c has SENSOR_PURPOSE + c // 4.
SENSOR_PURPOSE = 1 << 28
START_PURPOSE = 1 << 29


class Ensemble(NamedTuple):
    """A sampled pointing loop for many runs side by side, as arrays.

    The plant is that of `Plant`, without its counts in the type: one compiled kernel serves every mirror. ``optics``
    (axes, outputs) turns its outputs into line-of-sight angles y. ``E_held`` is E0 + E1, ``E_back`` what takes it back,
    -E1. Line-of-sight error e = reference + disturbance - y.

    Disturbance: s[k+1] = As s + Bs g with independent standard normal g (one a source and plant step; ``purpose`` names
    each source's stream), d = Cs s; As by diagonal and neighbour coupling, no rest. Sensors: the optical one delivers e
    of ``sensor_delay_steps`` plant steps ago every ``sensor_every`` samples, with ``optical_noise`` (rms, by axis) and
    ``optical_resolution``, and holds its last reading while the radial error is beyond ``field_of_view``; the gauge
    delivers the plant's outputs with ``gauge_noise`` and ``gauge_resolution``.

    Controller: m = (optical by axis, gauge by output, reference by axis); x[k+1] = A x + B m + L (clip(v) - v), and
    C x + D m = (v by actuator, then, with ``feedforward``, the inverse's target and its rate by actuator); what the
    inverse makes of the target is added to v ahead of the clip. Rows of ``actuator`` as in `Loop`, then DRIVE_LOW and
    DRIVE_HIGH, the drive range that the mirror was identified in. Inverse as in `Loop`.
    """

    step_s: float
    feedback: bool
    diagonal: Floats
    coupling: Floats
    rest: Rows
    B0: Floats
    B1: Floats
    E0: Floats
    E1: Floats
    E_held: Floats
    E_back: Floats
    F: Floats
    G: Floats
    Cy: Floats
    Dy: Floats
    Ky: Floats
    bouc_wen: Floats
    operator: Floats
    play_start: Indices
    play_threshold: Floats
    play_weight: Floats
    optics: Floats
    shaping_diagonal: Floats
    shaping_coupling: Floats
    shaping_noise: Floats
    shaping_output: Floats
    purpose: Indices
    seed: Indices
    steps_per_sample: int
    delay_steps: int
    sensor_delay_steps: int
    sensor_every: int
    optical_noise: Floats
    optical_resolution: float
    field_of_view: float
    gauge_noise: float
    gauge_resolution: float
    feedforward: bool
    A: Floats
    B: Floats
    C: Floats
    D: Floats
    L: Floats
    actuator: Floats
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


class EnsembleState(NamedTuple):
    """The memory of `LANES` runs; the kernel writes into these arrays. A row of LANES numbers for each quantity.

    ``place``: control sample, plant step, and 1 where statistics are taken. Rows too: ``sum_square`` (axes) and
    ``largest`` (radial error squared) of every plant step, ``sum`` (axes) of the control samples, ``counts`` (COUNT_*).
    ``histogram`` (LANES, BINS) counts the radial error at the end of each control sample.

    ``drawn`` is empty where the runs draw their random numbers themselves. Else it is what `draw_loop` has drawn for
    the control samples of the next call: runs of other controllers and on other mirrors share it.
    """

    first_run: Indices
    place: Integers
    x: Floats
    x_next: Floats
    drive: Floats
    bank: Floats
    play: Floats
    y: Floats
    shaping: Floats
    disturbance: Floats
    gauss: Floats
    sensor_gauss: Floats
    error: Floats
    error_ring: Floats
    measured: Floats
    xc: Floats
    xc_next: Floats
    output: Floats
    command: Floats
    target: Floats
    inverse: Floats
    inverse_play: Floats
    inverse_lag: Floats
    work: Floats
    sum: Floats
    sum_square: Floats
    largest: Floats
    counts: Floats
    histogram: NDArray[np.int32]
    drawn: Floats


SAMPLE, STEP, COUNTING = range(3)  # of ``place``


class Shift(NamedTuple):
    """What is added to the random numbers of LANES runs from the control sample ``first_sample`` on.

    The disturbances' number of source w at a plant step k from there grows by ``step[k, w]`` @ ``size``, the reading's
    number i (optical by axis, then gauge by output) at a sample by ``sample[k, i]`` @ ``size``. ``size`` has a row of
    runs for each direction, flat (directions x LANES), the others a last index by direction. Behind the end of ``step``
    and ``sample``, which may be empty, the numbers are as they are drawn.
    """

    first_sample: int
    step: Floats
    sample: Floats
    size: Floats


UNSHIFTED = Shift(0, np.zeros((0, 0, 0)), np.zeros((0, 0, 0)), np.zeros(0))

# A Taylor series about 0 of (exp(r) - 1) / r up to r^11, and of log as in the C library fdlibm, for |r| <= ln 2 / 2.
_ROUND = 6755399441055744.0  # 1.5 x 2^52: adding it leaves the nearest whole number in the low bits
_LOG2_E = 1.4426950408889634
_LN2_HIGH, _LN2_LOW = 6.93147180369123816490e-01, 1.90821492927058770002e-10
_ONE_BITS = np.int64(0x3FF0000000000000)
_ROOT_HALF_BITS = np.int64(0x3FE6A09E667F3BCD)
_ROUND_BITS = np.int64(0x4338000000000000)
_MANTISSA = np.int64(52)

_ROW = np.uint64(LANES)  # unsigned, as every place in a row of runs: no test for a negative index in the loops

if _numba.DISABLE_JIT:  # set when numba is loaded

    def _bits(x: Any) -> Any:
        return np.float64(x).view(np.int64)

    def _number(bits: Any) -> Any:
        return np.int64(bits).view(np.float64)

    def _at(row: Any) -> Any:
        return np.uint64(row) * _ROW

else:

    @intrinsic
    def _bits(typingctx: Any, x: Any) -> Any:
        """The 64 bits of a float as a whole number: no instruction at all, where a union would go through memory."""

        def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            return builder.bitcast(arguments[0], context.get_value_type(signature.return_type))

        return types.int64(types.float64), generate

    @intrinsic
    def _number(typingctx: Any, bits: Any) -> Any:
        """The float of 64 bits."""

        def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            return builder.bitcast(arguments[0], context.get_value_type(signature.return_type))

        return types.float64(types.int64), generate

    @intrinsic
    def _at(typingctx: Any, row: Any) -> Any:
        """Where a row of runs begins. As an instruction, for it stands at hundreds of places."""

        def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            return builder.mul(arguments[0], context.get_constant(types.uint64, LANES))

        return types.uint64(types.uint64), generate


@_inline
def _grown(r):  # type: ignore[no-untyped-def]
    """exp(r) - 1 for |r| <= ln 2 / 2, to rounding error."""
    r2 = r * r
    r4 = r2 * r2
    low = (1.0 + r * (1.0 / 2.0)) + r2 * (1.0 / 6.0 + r * (1.0 / 24.0))
    middle = (1.0 / 120.0 + r * (1.0 / 720.0)) + r2 * (1.0 / 5040.0 + r * (1.0 / 40320.0))
    high = (1.0 / 362880.0 + r * (1.0 / 3628800.0)) + r2 * (1.0 / 39916800.0 + r * (1.0 / 479001600.0))
    return r * (low + r4 * (middle + r4 * high))


@_inline
def _row_exp(x):  # type: ignore[no-untyped-def]
    """exp(x) without a branch or a call, held outside -700 to 700: 2^n exp(r) with r = x - n ln 2."""
    x = min(max(x, -700.0), 700.0)
    shifted = x * _LOG2_E + _ROUND
    n = shifted - _ROUND
    r = (x - n * _LN2_HIGH) - n * _LN2_LOW
    return _number(_bits(1.0 + _grown(r)) + (_bits(shifted) << _MANTISSA))


@_inline
def _row_relaxation(k):  # type: ignore[no-untyped-def]
    """(1 - exp(-k)) / k without a branch or a call, 1 at 0: exp(x) - 1 = 2^n (exp(r) - 1) + (2^n - 1)."""
    x = min(max(-k, -700.0), 700.0)
    shifted = x * _LOG2_E + _ROUND
    n = shifted - _ROUND
    r = (x - n * _LN2_HIGH) - n * _LN2_LOW
    scale = _number(_ONE_BITS + (_bits(shifted) << _MANTISSA))
    grown = scale * _grown(r) + (scale - 1.0)
    return 1.0 if x == 0.0 else grown / x


@_inline
def _row_log(x):  # type: ignore[no-untyped-def]
    """ln(x) for normal x > 0 without a branch or a call."""
    bits = _bits(x)
    octave = (bits - _ROOT_HALF_BITS) >> _MANTISSA
    n = _number(octave + _ROUND_BITS) - _ROUND
    f = _number(bits - (octave << _MANTISSA)) - 1.0
    s = f / (2.0 + f)
    z = s * s
    w = z * z
    even = w * (0.3999999999940941908 + w * (0.2222219843214978396 + w * 0.1531383769920937332))
    odd = 0.6666666666666735130 + w * (0.2857142874366239149 + w * (0.1818357216161805012 + w * 0.1479819860511658591))
    half = 0.5 * f * f
    return n * _LN2_HIGH - ((half - (s * (half + even + z * odd) + n * _LN2_LOW)) - f)


@_compile
def _copy(source, target, first, count):  # type: ignore[no-untyped-def]
    """The first rows of one array to the rows from ``first`` on of another."""
    at = _at(first)
    for r in range(_at(count)):
        target[at + r] = source[r]


@_compile
def _take(source, first, target, count):  # type: ignore[no-untyped-def]
    """The rows from ``first`` on of one array to the first rows of another."""
    at = _at(first)
    for r in range(_at(count)):
        target[r] = source[at + r]


# Philox 4x32 with ten rounds (Salmon et al., SC11): numbers by counter and key, so that no run waits for another.
_LOW32 = np.uint64(0xFFFFFFFF)
_HALF_WORD = np.uint64(32)
_MULTIPLY0, _MULTIPLY1 = np.uint64(0xD2511F53), np.uint64(0xCD9E8D57)
_WEYL0, _WEYL1 = np.uint64(0x9E3779B9), np.uint64(0xBB67AE85)
_TWO_52_BITS = np.int64(0x4330000000000000)
_TWO_52 = 4503599627370496.0


@_inline
def _philox(c0, c1, c2, c3, k0, k1):  # type: ignore[no-untyped-def]
    """Four random words of 32 bits from four words of counter and two of key, each in 64 bits."""
    for _ in range(10):
        first, second = _MULTIPLY0 * (c0 & _LOW32), _MULTIPLY1 * (c2 & _LOW32)
        c0, c2 = (second >> _HALF_WORD) ^ c1 ^ k0, (first >> _HALF_WORD) ^ c3 ^ k1
        c1, c3 = second, first
        k0, k1 = (k0 + _WEYL0) & _LOW32, (k1 + _WEYL1) & _LOW32
    return c0 & _LOW32, c1 & _LOW32, c2 & _LOW32, c3 & _LOW32


@_inline
def _uniform(word):  # type: ignore[no-untyped-def]
    """A word of 32 bits as a number inside (0, 1): (word + 1/2) / 2^32."""
    return (_number(np.int64(word) | _TWO_52_BITS) - _TWO_52 + 0.5) * (1.0 / 4294967296.0)


@_inline
def _cosine_sine(turns):  # type: ignore[no-untyped-def]
    """cos and sin of 2 pi turns, 0 <= turns <= 1, without a branch or a call, to 2.1e-14."""
    shifted = 4.0 * turns + _ROUND
    quarter = _bits(shifted)
    x = (4.0 * turns - (shifted - _ROUND)) * 1.5707963267948966
    x2 = x * x
    sine = x * (
        1.0
        + x2
        * (
            -1.0 / 6.0
            + x2
            * (
                1.0 / 120.0
                + x2 * (-1.0 / 5040.0 + x2 * (1.0 / 362880.0 + x2 * (-1.0 / 39916800.0 + x2 * (1.0 / 6227020800.0))))
            )
        )
    )
    cosine = 1.0 + x2 * (
        -1.0 / 2.0
        + x2
        * (
            1.0 / 24.0
            + x2
            * (
                -1.0 / 720.0
                + x2 * (1.0 / 40320.0 + x2 * (-1.0 / 3628800.0 + x2 * (1.0 / 479001600.0 - x2 * (1.0 / 87178291200.0))))
            )
        )
    )
    odd = (quarter & np.int64(1)) != 0
    c = -sine if odd else cosine
    s = cosine if odd else sine
    turned = (quarter & np.int64(2)) != 0
    return -c if turned else c, -s if turned else s


@_compile
def _gaussians(seed, first_run, purpose, block, rows, at):  # type: ignore[no-untyped-def]
    """Four standard normal numbers a run, by Box and Muller, into the four rows that begin at ``at``.

    Counter: block (64 bits), run (its low 32 bits), purpose; key: seed. The largest magnitude is 6.8.
    """
    low, high = np.uint64(block) & _LOW32, np.uint64(block) >> _HALF_WORD
    for r in range(_ROW):
        run = (first_run + r) & _LOW32
        a, b, c, d = _philox(low, high, run, purpose, seed[0], seed[1])
        near, far = np.sqrt(-2.0 * _row_log(_uniform(a))), np.sqrt(-2.0 * _row_log(_uniform(c)))
        cosine, sine = _cosine_sine(_uniform(b))
        rows[at + r] = near * cosine
        rows[at + _at(1) + r] = near * sine
        cosine, sine = _cosine_sine(_uniform(d))
        rows[at + _at(2) + r] = far * cosine
        rows[at + _at(3) + r] = far * sine


@_compile
def gaussian_kernel(seed, first_run, purpose, first_block, numbers):  # type: ignore[no-untyped-def]
    """Standard normal numbers of LANES runs from one stream: fills ``numbers``, flat (4 x blocks, LANES)."""
    for block in range(numbers.size // (4 * LANES)):
        _gaussians(seed, first_run[0], purpose, first_block + block, numbers, _at(4 * block))


@_merge
def _clear(rows, at):  # type: ignore[no-untyped-def]
    for r in range(_ROW):
        rows[at + r] = 0.0


@_merge
def _weigh(weights, rows, first, stride, total, at, fresh):  # type: ignore[no-untyped-def]
    """total[at:] = (or, if it is not fresh, +=) sum of weights[j] x rows[first + stride j:], a row of runs each.

    A weight of 0 costs nothing. Places are unsigned, as `_at` gives them: so all callers share one compiled function.

    Returns whether the total is still to be written. The total must lie in another array than the rows.
    """
    j = 0
    while j < weights.size:
        gain, source = weights[j], first + stride * np.uint64(j)
        j += 1
        if gain == 0.0:
            continue
        if j < weights.size and weights[j] != 0.0:  # two at a time, or two and two with the total in hand
            other, second = weights[j], first + stride * np.uint64(j)
            j += 1
            if j + 1 < weights.size and (weights[j] != 0.0) & (weights[j + 1] != 0.0):
                near, third = weights[j], first + stride * np.uint64(j)
                far, fourth = weights[j + 1], first + stride * np.uint64(j + 1)
                j += 2
                if fresh:
                    for r in range(_ROW):
                        begun = gain * rows[source + r] + other * rows[second + r]
                        total[at + r] = begun + (near * rows[third + r] + far * rows[fourth + r])
                else:
                    for r in range(_ROW):
                        begun = total[at + r] + (gain * rows[source + r] + other * rows[second + r])
                        total[at + r] = begun + (near * rows[third + r] + far * rows[fourth + r])
            elif fresh:
                for r in range(_ROW):
                    total[at + r] = gain * rows[source + r] + other * rows[second + r]
            else:
                for r in range(_ROW):
                    total[at + r] += gain * rows[source + r] + other * rows[second + r]
        elif fresh:
            for r in range(_ROW):
                total[at + r] = gain * rows[source + r]
        else:
            for r in range(_ROW):
                total[at + r] += gain * rows[source + r]
        fresh = False
    return fresh


@_merge
def _weigh_some(weights, rows, first, stride, total, at, fresh):  # type: ignore[no-untyped-def]
    """As `_weigh`, without the call where all weights are 0, as most are."""
    some = False
    for j in range(weights.size):
        some = some or weights[j] != 0.0
    return _weigh(weights, rows, first, stride, total, at, fresh) if some else fresh


@_merge
def _sum_rows(weights, rows, first, stride, total, row):  # type: ignore[no-untyped-def]
    """total row = sum of weights[j] x row first + stride j, as `_weigh` takes it."""
    if _weigh(weights, rows, first, stride, total, _at(row), True):
        _clear(total, _at(row))


@_compile
def _shift_rows(weights, size, rows, first, stride):  # type: ignore[no-untyped-def]
    """row first + stride i += weights[i] @ size, in a function by itself as few calls of the loop need it."""
    for i in range(weights.shape[0]):
        _weigh_some(weights[i], size, _at(0), _at(1), rows, first + stride * np.uint64(i), False)


@_compile
def _modal_step(diagonal, coupling, x):  # type: ignore[no-untyped-def]
    """x = Ad x in place, for Ad of neighbouring pairs."""
    for i in range(0, diagonal.size, 2):
        keep0, cross0, keep1, cross1 = diagonal[i], coupling[i], diagonal[i + 1], coupling[i + 1]
        at = _at(i)
        for r in range(_ROW):
            a, b = x[at + r], x[at + _at(1) + r]
            x[at + r] = keep0 * a + cross0 * b
            x[at + _at(1) + r] = keep1 * b + cross1 * a


@_compile
def _add_element(before, now, bank, e, x):  # type: ignore[no-untyped-def]
    """x += before z_before + now z of element e, for columns of neighbouring pairs of states."""
    z, z_before = _at(e * BANK_FIELDS + BANK_Z), _at(e * BANK_FIELDS + BANK_Z_BEFORE)
    for i in range(0, before.shape[0], 2):
        a, b, c, d = before[i, e], now[i, e], before[i + 1, e], now[i + 1, e]
        if (a != 0.0) | (b != 0.0) | (c != 0.0) | (d != 0.0):
            at = _at(i)
            for r in range(_ROW):
                first, last = bank[z_before + r], bank[z + r]
                x[at + r] += a * first + b * last
                x[at + _at(1) + r] += c * first + d * last


@_merge
def _modal_element(diagonal, coupling, before, now, bank, x):  # type: ignore[no-untyped-def]
    """x = Ad x + before z_before + now z of the first element, in place: both in one pass over the memory."""
    z, z_before = _at(BANK_Z), _at(BANK_Z_BEFORE)
    for i in range(0, diagonal.size, 2):
        keep0, cross0, keep1, cross1 = diagonal[i], coupling[i], diagonal[i + 1], coupling[i + 1]
        before0, now0, before1, now1 = before[i, 0], now[i, 0], before[i + 1, 0], now[i + 1, 0]
        at = _at(i)
        for r in range(_ROW):
            a, b, first, last = x[at + r], x[at + _at(1) + r], bank[z_before + r], bank[z + r]
            x[at + r] = keep0 * a + cross0 * b + before0 * first + now0 * last
            x[at + _at(1) + r] = keep1 * b + cross1 * a + before1 * first + now1 * last


@_inline
def _small_exp(x):  # type: ignore[no-untyped-def]
    """exp(x) for |x| <= 0.02, to rounding error."""
    return 1.0 + x * (
        1.0 + x * (1.0 / 2.0 + x * (1.0 / 6.0 + x * (1.0 / 24.0 + x * (1.0 / 120.0 + x * (1.0 / 720.0)))))
    )


@_compile
def _mend(rows, e, bank, at, rate_gain, power):  # type: ignore[no-untyped-def]
    """h and z of those runs whose h changes sign inside the step, which few do; of all for another exponent than 1."""
    for r in range(_ROW):
        h, end, travel = bank[at + _at(BANK_H_BEFORE) + r], bank[at + _at(BANK_H) + r], bank[at + _at(BANK_TRAVEL) + r]
        if power or (h * end <= 0.0 and h * rows[e, EPSILON] * travel < 0.0):
            rate = _clamp(travel * rate_gain, rows[e, RATE_LIMIT])
            mended = _bouc_wen_advance(h, travel, rate, rows, e)
            bank[at + _at(BANK_H) + r] = mended
            bank[at + _at(BANK_Z) + r] += mended - end


@_merge
def _advance_bouc_wen(rows, e, bank, at, rate_gain, counts):  # type: ignore[no-untyped-def]
    """BANK_Q to BANK_Q_NEXT, exactly, for a row of runs: as `bouc_wen_step`, with a zero crossing mended by itself.

    Leaves h, and z = d1 exp(-d2 rate) (q + bias) - d1 bias + h, each with what it was before.
    """
    limit, delta, d2 = rows[e, RATE_LIMIT], rows[e, DELTA], -rows[e, D2]
    d1, bias, epsilon = rows[e, D1], rows[e, BIAS], rows[e, EPSILON]
    alpha, beta, gamma, eta = rows[e, ALPHA], rows[e, BETA], rows[e, GAMMA], rows[e, ETA]
    if (epsilon == 0.0) & (d2 == 0.0):  # a slow gain alone, as without hysteresis: h stays 0
        for r in range(_ROW):
            q = bank[at + _at(BANK_Q_NEXT) + r]
            free = (q - bank[at + _at(BANK_Q) + r]) * rate_gain
            counts[_at(COUNT_CLAMPED) + r] += 0.0 if free == min(max(free, -limit), limit) else 1.0
            bank[at + _at(BANK_Z_BEFORE) + r] = bank[at + _at(BANK_Z) + r]
            bank[at + _at(BANK_Z) + r] = d1 * (q + bias) - d1 * bias
            bank[at + _at(BANK_Q) + r] = q
        return
    crossing, small = 0, abs(d2) * limit <= 0.02
    # Two loops: their chains of arithmetic are long, and shorter ones overlap better from run to run.
    for r in range(_ROW):
        q = bank[at + _at(BANK_Q_NEXT) + r]
        travel = q - bank[at + _at(BANK_Q) + r]
        free = travel * rate_gain
        rate = min(max(free, -limit), limit)
        counts[_at(COUNT_CLAMPED) + r] += 0.0 if free == rate else 1.0
        bank[at + _at(BANK_FORCING) + r] = epsilon * _row_exp(delta * abs(rate)) * travel
        bank[at + _at(BANK_TRAVEL) + r] = travel
        bank[at + _at(BANK_Z_BEFORE) + r] = bank[at + _at(BANK_Z) + r]
        grown = _small_exp(d2 * rate) if small else _row_exp(d2 * rate)
        bank[at + _at(BANK_Z) + r] = d1 * grown * (q + bias) - d1 * bias
        bank[at + _at(BANK_Q) + r] = q
    for r in range(_ROW):
        h, forcing, travel = (
            bank[at + _at(BANK_H) + r],
            bank[at + _at(BANK_FORCING) + r],
            bank[at + _at(BANK_TRAVEL) + r],
        )
        common, split = alpha * abs(travel) + eta * travel, gamma * abs(travel) + beta * travel
        decay = common + split if (h if h != 0.0 else forcing) > 0.0 else common - split
        end = h + (forcing - decay * h) * _row_relaxation(decay)
        crossing += 1 if (h * forcing < 0.0) & (h * end <= 0.0) else 0
        bank[at + _at(BANK_H_BEFORE) + r] = h
        bank[at + _at(BANK_H) + r] = end
        bank[at + _at(BANK_Z) + r] += end
    power = rows[e, POWER] != 0.0
    if crossing > 0 or power:
        _mend(rows, e, bank, at, rate_gain, power)


@_inline
def _advance_operator(p, s, o, at):  # type: ignore[no-untyped-def]
    """BANK_Q to BANK_Q_NEXT for the plays of operator o; leaves z. BANK_TRAVEL holds what widens the thresholds."""
    bank, counts, play = s.bank, s.counts, s.play
    widening, limit = p.operator[o, WIDENING], p.operator[o, WIDENING_LIMIT]
    for r in range(_ROW):
        q = bank[at + _at(BANK_Q_NEXT) + r]
        free = abs(q - bank[at + _at(BANK_Q) + r]) / p.step_s
        bank[at + _at(BANK_TRAVEL) + r] = widening * min(free, limit) if widening != 0.0 else 0.0
        counts[_at(COUNT_CLAMPED) + r] += 1.0 if (widening != 0.0) & (free > limit) else 0.0
        bank[at + _at(BANK_Z_BEFORE) + r] = bank[at + _at(BANK_Z) + r]
        bank[at + _at(BANK_Z) + r] = 0.0
        bank[at + _at(BANK_Q) + r] = q
    for j in range(p.play_start[o], p.play_start[o + 1]):
        threshold, weight = p.play_threshold[j], p.play_weight[j]
        wide = 1.0 if threshold > 0.0 else 0.0
        row = _at(j)
        for r in range(_ROW):
            q, half = bank[at + _at(BANK_Q) + r], threshold + wide * bank[at + _at(BANK_TRAVEL) + r]
            value = max(q - half, min(q + half, play[row + r]))
            play[row + r] = value
            bank[at + _at(BANK_Z) + r] += weight * value


@_inline
def _advance_bank(p, s):  # type: ignore[no-untyped-def]
    """Drive of each element at the end of the step, its operator, and its output before and now."""
    first_operator = p.bouc_wen.shape[0]
    for e in range(p.G.shape[0]):
        at, row = _at(e * BANK_FIELDS), e * BANK_FIELDS + BANK_Q_NEXT
        _sum_rows(p.G[e], s.drive, _at(DRIVE_NOW), _at(DRIVE_FIELDS), s.bank, row)
        if p.feedback:
            _weigh(p.F[e], s.x, _at(0), _at(1), s.bank, _at(row), False)
        if e < first_operator:
            _advance_bouc_wen(p.bouc_wen, e, s.bank, at, 1.0 / p.step_s, s.counts)
        else:
            _advance_operator(p, s, e - first_operator, at)


@_inline
def _ensemble_plant(p, s):  # type: ignore[no-untyped-def]
    """One plant step behind the amplifier's: as `_predict` and `_plant_step`, for a row of runs."""
    states, elements, several = p.diagonal.size, p.G.shape[0], p.rest.value.size > 0
    if several:  # before x moves
        for i in range(states):
            if p.rest.start[i] < p.rest.start[i + 1]:
                _clear(s.x_next, _at(i))
            for j in range(p.rest.start[i], p.rest.start[i + 1]):
                gain, source, target = p.rest.value[j], _at(p.rest.column[j]), _at(i)
                for r in range(_ROW):
                    s.x_next[target + r] += gain * s.x[source + r]
    if not p.feedback:  # else the drive of an element is that of the predicted x: with z held
        _advance_bank(p, s)
    if elements > 0 and not p.feedback:
        _modal_element(p.diagonal, p.coupling, p.E0, p.E1, s.bank, s.x)
        for e in range(1, elements):
            _add_element(p.E0, p.E1, s.bank, e, s.x)
    else:
        _modal_step(p.diagonal, p.coupling, s.x)
    for i in range(states):
        _weigh_some(p.B0[i], s.drive, _at(DRIVE_BEFORE), _at(DRIVE_FIELDS), s.x, _at(i), False)
        _weigh_some(p.B1[i], s.drive, _at(DRIVE_NOW), _at(DRIVE_FIELDS), s.x, _at(i), False)
        if several and p.rest.start[i] < p.rest.start[i + 1]:
            for r in range(_ROW):
                s.x[_at(i) + r] += s.x_next[_at(i) + r]
    if p.feedback:
        for i in range(states):
            _weigh_some(p.E_held[i], s.bank, _at(BANK_Z), _at(BANK_FIELDS), s.x, _at(i), False)
        _advance_bank(p, s)
        for e in range(elements):
            _add_element(p.E_back, p.E1, s.bank, e, s.x)
    for o in range(p.Cy.shape[0]):
        fresh = _weigh(p.Cy[o], s.x, _at(0), _at(1), s.y, _at(o), True)
        fresh = _weigh_some(p.Dy[o], s.drive, _at(DRIVE_NOW), _at(DRIVE_FIELDS), s.y, _at(o), fresh)
        if _weigh_some(p.Ky[o], s.bank, _at(BANK_Z), _at(BANK_FIELDS), s.y, _at(o), fresh):
            _clear(s.y, _at(o))


@_inline
def _ensemble_amplifier(p, s, due):  # type: ignore[no-untyped-def]
    """The drive at the end of the plant step; ``due`` is the row of commands that it moves towards."""
    actuators = p.actuator.shape[0]
    for a in range(actuators):
        follow, slew = p.actuator[a, FOLLOW], p.actuator[a, SLEW_STEP]
        low, high = p.actuator[a, DRIVE_LOW], p.actuator[a, DRIVE_HIGH]
        at, source = _at(a * DRIVE_FIELDS), _at(due * actuators + a)
        drive, command, counts = s.drive, s.command, s.counts
        for r in range(_ROW):
            before = drive[at + _at(DRIVE_NOW) + r]
            free = (command[source + r] - before) * follow
            move = min(max(free, -slew), slew)
            now = before + move
            drive[at + _at(DRIVE_BEFORE) + r] = before
            drive[at + _at(DRIVE_NOW) + r] = now
            counts[_at(COUNT_SLEW) + r] += 0.0 if move == free else 1.0
            counts[_at(COUNT_OUTSIDE) + r] += 1.0 if (now < low) | (now > high) else 0.0


@_inline
def _ensemble_disturbance(p, s, shift):  # type: ignore[no-untyped-def]
    """The disturbance one plant step on, from four steps' worth of random numbers at a time."""
    step = s.place[STEP]
    _draw_sources(p, s)
    k = step - shift.first_sample * p.steps_per_sample
    if 0 <= k < shift.step.shape[0]:
        _shift_rows(shift.step[k], shift.size, s.gauss, _at(step % 4), _at(4))
    _shape(p, s)


@_inline
def _draw_sources(p, s):  # type: ignore[no-untyped-def]
    """The random numbers of the disturbances' sources, where those of the last four steps are used up."""
    step = s.place[STEP]
    if step % 4 == 0:
        for w in range(p.purpose.size):
            _gaussians(p.seed, s.first_run[0], p.purpose[w], step // 4, s.gauss, _at(4 * w))


@_inline
def _shape(p, s):  # type: ignore[no-untyped-def]
    """The disturbance one plant step on, from the random numbers at hand."""
    step = s.place[STEP]
    _modal_step(p.shaping_diagonal, p.shaping_coupling, s.shaping)
    for i in range(p.shaping_diagonal.size):
        _weigh_some(p.shaping_noise[i], s.gauss, _at(step % 4), _at(4), s.shaping, _at(i), False)
    for i in range(p.shaping_output.shape[0]):
        _sum_rows(p.shaping_output[i], s.shaping, _at(0), _at(1), s.disturbance, i)


@_inline
def _line_of_sight_error(p, s, i, begin, end, share):  # type: ignore[no-untyped-def]
    """e = reference + disturbance - y of axis i, the references at a share of the way from ``begin`` to ``end``."""
    at, error, disturbance, y = _at(i), s.error, s.disturbance, s.y
    reference = begin[0] + share * (end[0] - begin[0])
    for o in range(p.optics.shape[1]):
        gain, source = -p.optics[i, o], _at(o)
        if o == 0 and begin.size > 1:
            for r in range(_ROW):
                own = begin[r] + share * (end[r] - begin[r])
                error[at + r] = own + disturbance[at + r] + gain * y[source + r]
        elif o == 0:
            for r in range(_ROW):
                error[at + r] = reference + disturbance[at + r] + gain * y[source + r]
        elif gain != 0.0:
            for r in range(_ROW):
                error[at + r] += gain * y[source + r]


@_inline
def _statistics(p, s):  # type: ignore[no-untyped-def]
    """What a plant step adds to the squares and the largest radial error; ``work`` is left with its square."""
    work, error, square, largest = s.work, s.error, s.sum_square, s.largest
    for i in range(p.optics.shape[0]):
        at = _at(i)
        for r in range(_ROW):
            e = error[at + r]
            square[at + r] += e * e
            work[r] = e * e + (work[r] if i > 0 else 0.0)
    for r in range(_ROW):
        largest[r] = max(largest[r], work[r])


@_merge
def _count_radial(error, axes, work, total, histogram):  # type: ignore[no-untyped-def]
    """What a control sample adds to the sums and to the histogram of the radial error, whose square is in ``work``."""
    for r in range(_at(axes)):
        total[r] += error[r]
    for r in range(_ROW):
        place = (_bits(work[r]) >> _BIN_SHIFT) - _BIN_OFFSET
        histogram[r, min(max(place, 0), BINS - 1)] += np.int32(1)


@_inline
def _draw_sensors(p, s):  # type: ignore[no-untyped-def]
    """The random numbers of a control sample's readings."""
    for word in range(0, p.optics.shape[0] + p.optics.shape[1], 4):
        purpose = np.uint64(SENSOR_PURPOSE + word // 4)
        _gaussians(p.seed, s.first_run[0], purpose, s.place[SAMPLE], s.sensor_gauss, _at(word))


@_merge
def _measure(p, s, reference, shift, drawn):  # type: ignore[no-untyped-def]
    """The readings m of a control sample: optical, gauge, reference. ``drawn`` is its first row of what is drawn."""
    axes, outputs, sample = p.optics.shape[0], p.optics.shape[1], s.place[SAMPLE]
    noisy = p.gauge_noise > 0.0
    for i in range(axes):
        noisy = noisy or p.optical_noise[i] > 0.0
    if noisy and s.drawn.size > 0:
        _take(s.drawn, drawn, s.sensor_gauss, axes + outputs)
    elif noisy:
        _draw_sensors(p, s)
    k = sample - shift.first_sample
    if noisy and 0 <= k < shift.sample.shape[0]:
        _shift_rows(shift.sample[k], shift.size, s.sensor_gauss, _at(0), _at(1))
    if sample % p.sensor_every == 0:
        _measure_optical(p, s)
    for o in range(outputs):
        at, y, gauss, measured = _at(axes + o), s.y, s.sensor_gauss, s.measured
        for r in range(_ROW):
            measured[at + r] = y[_at(o) + r] + p.gauge_noise * gauss[at + r]
        if p.gauge_resolution > 0.0:
            for r in range(_ROW):
                measured[at + r] = _quantised(measured[at + r], p.gauge_resolution)
    own = np.uint64(1 if reference.shape[1] > 1 else 0)
    for i in range(axes):
        for r in range(_ROW):
            s.measured[_at(axes + outputs + i) + r] = reference[i, own * r]


@_inline
def _measure_optical(p, s):  # type: ignore[no-untyped-def]
    """A new reading of the delayed error where the spot is inside the field of view; elsewhere the last one stays."""
    axes, measured, work, ring, gauss = p.optics.shape[0], s.measured, s.work, s.error_ring, s.sensor_gauss
    length = p.sensor_delay_steps + 1
    due = _at((s.place[STEP] + 1) % length * axes)
    _clear(work, _at(0))
    for i in range(axes):
        for r in range(_ROW):
            e = ring[due + _at(i) + r]
            work[r] += e * e
    seen = p.field_of_view * p.field_of_view
    for i in range(axes):
        noise = p.optical_noise[i]
        for r in range(_ROW):
            new = ring[due + _at(i) + r] + noise * gauss[_at(i) + r]
            measured[_at(i) + r] = new if work[r] <= seen else measured[_at(i) + r]
        if p.optical_resolution > 0.0:
            for r in range(_ROW):
                measured[_at(i) + r] = _quantised(measured[_at(i) + r], p.optical_resolution)
    for r in range(_ROW):
        s.counts[_at(COUNT_LOST) + r] += 0.0 if work[r] <= seen else 1.0


@_merge
def _ensemble_inverse(p, s):  # type: ignore[no-untyped-def]
    """Adds to each actuator's output what the inverse makes of its target: as `_inverse`, with the rate as given."""
    actuators, output, target = p.actuator.shape[0], s.output, s.target
    for a in range(actuators):
        now = _at(2 * a + 1)
        for r in range(_ROW):
            target[_at(2 * a) + r] = target[now + r]
            target[now + r] = output[_at(actuators + a) + r]
        for j in range(p.inverse_lag_keep.size):
            if p.inverse_lag_actuator[j] == a:
                for r in range(_ROW):
                    target[now + r] -= p.inverse_lag_weight[j] * s.inverse_lag[_at(j) + r]
        for r in range(_ROW):
            s.work[_at(a) + r] = p.inverse_direct[a] * target[now + r]
    for e in range(p.inverse_bouc_wen.shape[0]):
        _inverse_bouc_wen(p, s, e, np.int64(p.inverse_bouc_wen_actuator[e]))
    for a in range(actuators):
        _inverse_plays(p, s, a)
        for r in range(_ROW):
            output[_at(a) + r] += s.work[_at(a) + r]
    for j in range(p.inverse_lag_keep.size):
        keep, drive, lag = p.inverse_lag_keep[j], _at(p.inverse_lag_actuator[j]), s.inverse_lag
        for r in range(_ROW):
            lag[_at(j) + r] = keep * lag[_at(j) + r] + (1.0 - keep) * s.work[drive + r]


@_inline
def _inverse_bouc_wen(p, s, e, a):  # type: ignore[no-untyped-def]
    rows, actuators = p.inverse_bouc_wen, p.actuator.shape[0]
    d1, d2, bias, limit = rows[e, D1], rows[e, D2], rows[e, BIAS], rows[e, RATE_LIMIT]
    for r in range(_ROW):
        before, now = s.target[_at(2 * a) + r], s.target[_at(2 * a + 1) + r]
        free = s.output[_at(2 * actuators + a) + r] / d1
        rate = min(max(free, -limit), limit)
        s.counts[_at(COUNT_INVERSE_CLAMPED) + r] += 0.0 if rate == free else 1.0
        h = _bouc_wen_advance(s.inverse[_at(e) + r], (now - before) / d1, rate, rows, e)
        s.inverse[_at(e) + r] = h
        s.work[_at(a) + r] += (now - h + d1 * bias) / (d1 * _row_exp(-d2 * rate)) - bias


@_inline
def _inverse_plays(p, s, a):  # type: ignore[no-untyped-def]
    widening, limit = p.inverse_widening[a, WIDENING], p.inverse_widening[a, WIDENING_LIMIT]
    actuators, now = p.actuator.shape[0], _at(2 * a + 1)
    for j in range(p.inverse_play_threshold.size):
        if p.inverse_play_actuator[j] == a:
            threshold, weight = p.inverse_play_threshold[j], p.inverse_play_weight[j]
            wide = widening if threshold > 0.0 else 0.0
            for r in range(_ROW):
                half = threshold + (wide * min(abs(s.output[_at(2 * actuators + a) + r]), limit) if wide else 0.0)
                q = s.target[now + r]
                value = max(q - half, min(q + half, s.inverse_play[_at(j) + r]))
                s.inverse_play[_at(j) + r] = value
                s.work[_at(a) + r] += weight * value
    if widening != 0.0:
        for r in range(_ROW):
            beyond = abs(s.output[_at(2 * actuators + a) + r]) > limit
            s.counts[_at(COUNT_INVERSE_CLAMPED) + r] += 1.0 if beyond else 0.0


@_inline
def _control(p, s, length):  # type: ignore[no-untyped-def]
    """One sample of the controller: readings to commands, with inverse, clip and anti-windup."""
    states, actuators = p.A.shape[0], p.actuator.shape[0]
    for i in range(p.C.shape[0]):
        fresh = _weigh(p.C[i], s.xc, _at(0), _at(1), s.output, _at(i), True)
        if _weigh(p.D[i], s.measured, _at(0), _at(1), s.output, _at(i), fresh):
            _clear(s.output, _at(i))
    if p.feedforward:
        _ensemble_inverse(p, s)
    for i in range(states):
        fresh = _weigh(p.A[i], s.xc, _at(0), _at(1), s.xc_next, _at(i), True)
        if _weigh(p.B[i], s.measured, _at(0), _at(1), s.xc_next, _at(i), fresh):
            _clear(s.xc_next, _at(i))
    row = s.place[SAMPLE] % length
    for a in range(actuators):
        low, high = p.actuator[a, COMMAND_MIN], p.actuator[a, COMMAND_MAX]
        resolution, at = p.actuator[a, RESOLUTION], _at(row * actuators + a)
        command, output, counts = s.command, s.output, s.counts
        for r in range(_ROW):
            v = output[_at(a) + r]
            clipped = min(max(v, low), high)
            output[_at(a) + r] = clipped - v
            command[at + r] = clipped
            counts[_at(COUNT_SATURATED) + r] += 0.0 if clipped == v else 1.0
        if resolution > 0.0:
            for r in range(_ROW):
                command[at + r] = _quantised(command[at + r], resolution)
    for i in range(states):
        _weigh(p.L[i], s.output, _at(0), _at(1), s.xc_next, _at(i), False)
    _copy(s.xc_next, s.xc, 0, states)


@_compile
def _record(k, rows, width, trace, channel):  # type: ignore[no-untyped-def]
    """Rows into the channels of a trace from ``channel`` on; returns the channel behind them."""
    for row in range(width):
        for r in range(_ROW):
            trace[k, channel + row, r] = rows[_at(row) + r]
    return channel + width


@_compile
def draw_loop(p, s, samples, drawn):  # type: ignore[no-untyped-def]
    """What LANES runs draw over some control samples, into the rows of ``drawn``, flat, sample by sample.

    For each: a random number for every reading (optical by axis, then gauge by output), then at every plant step's end
    the disturbance by axis. Loops alike in their disturbances, clock, axes and outputs draw the same. Of the state the
    disturbance goes on, and nothing else.
    """
    axes, steps, words = p.optics.shape[0], p.steps_per_sample, p.optics.shape[0] + p.optics.shape[1]
    row = 0
    for _ in range(samples):
        _draw_sensors(p, s)
        _copy(s.sensor_gauss, drawn, row, words)
        row += words
        for _ in range(steps):
            if p.shaping_diagonal.size > 0:
                _draw_sources(p, s)
                _shape(p, s)
            _copy(s.disturbance, drawn, row, axes)
            row += axes
            s.place[STEP] += 1
        s.place[SAMPLE] += 1


@_compile
def ensemble_loop(p, s, reference, residual, trace, shift):  # type: ignore[no-untyped-def]
    """Advance LANES runs over the control samples of ``reference``, linear between them.

    Its shape is (samples + 1, axes, 1), or with LANES in place of the 1 where each run has its own.
    Fills ``residual`` (samples, axes, LANES) with the line-of-sight error at the begin of each sample, if it has rows,
    and ``trace`` (samples, channels, LANES) likewise, once the sample has measured: disturbance by axis, drive before
    and now actuator by actuator, the plant's outputs, readings. Statistics are taken where ``place`` says so: squares
    and the largest error at the end of every plant step, sums and the histogram at the end of each control sample; the
    counters go on all the time. The states are left at the end, so that a following call continues. ``shift`` is added
    to the random numbers (UNSHIFTED: none); those that the runs began with are drawn already.
    """
    axes, steps, actuators = p.optics.shape[0], p.steps_per_sample, p.actuator.shape[0]
    length = s.command.size // (actuators * LANES)
    ring_length = p.sensor_delay_steps + 1
    words = axes + p.optics.shape[1]
    for k in range(reference.shape[0] - 1):
        drawn = k * (words + steps * axes)
        _measure(p, s, reference[k], shift, drawn)
        _control(p, s, length)
        if residual.shape[0] > 0:
            _record(k, s.error, axes, residual, 0)
        if trace.shape[0] > 0:
            channel = _record(k, s.disturbance, axes, trace, 0)
            channel = _record(k, s.drive, DRIVE_FIELDS * actuators, trace, channel)
            channel = _record(k, s.y, p.optics.shape[1], trace, channel)
            _record(k, s.measured, p.B.shape[1], trace, channel)
        for j in range(steps):
            due = (s.place[SAMPLE] + length + (j - p.delay_steps) // steps) % length
            _ensemble_amplifier(p, s, due)
            _ensemble_plant(p, s)
            if s.drawn.size > 0:
                _take(s.drawn, drawn + words + j * axes, s.disturbance, axes)
            elif p.shaping_diagonal.size > 0:
                _ensemble_disturbance(p, s, shift)
            s.place[STEP] += 1
            share = (j + 1) / steps
            for i in range(axes):
                _line_of_sight_error(p, s, i, reference[k, i], reference[k + 1, i], share)
            if p.sensor_delay_steps > 0 or j == steps - 1:
                _copy(s.error, s.error_ring, s.place[STEP] % ring_length * axes, axes)
            if s.place[COUNTING] == 1:
                _statistics(p, s)
        s.place[SAMPLE] += 1
        if s.place[COUNTING] == 1:
            _count_radial(s.error, axes, s.work, s.sum, s.histogram)


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
