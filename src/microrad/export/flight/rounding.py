"""How far single precision takes a controller's commands from double: a bound, by a running error analysis.

The analysis follows a recorded run sample by sample, to first order (Higham, Accuracy and Stability of Numerical
Algorithms, 2nd ed., SIAM 2002, ch. 3): each operation is wrong by at most ``UNIT`` of its result, in whatever order the
sums are taken, and so is each coefficient and each reading that is rounded to single precision. What that does to the
outputs of the linear part is summed with the sizes of its impulse responses, C A^j, so that a slowly decaying
oscillation counts as what it is; integrators and other slow blocks are compensated sums (Kahan). Through the inverse it
goes by the operators' sensitivities. An inverse that learns has a bound of its own kind, see `learning_rounding`.
"""

import math
from dataclasses import dataclass

import numpy as np

from microrad.core import kernels
from microrad.core.arrays import Floats
from microrad.export.flight.double_run import ForwardRun, InverseRun, Run, run_in_double, widened
from microrad.export.flight.learning_rounding import RUNS, SIGMAS, learning_errors
from microrad.export.flight.learning_run import UNIT
from microrad.export.linear_part.sections import Sections, compensated_states
from microrad.export.records import FlightController, InverseLaw, Vectors

_HIGHER_ORDERS = 1.01  # what a first-order analysis leaves out, generously
_POWER_TOLERANCE = 4e-6  # of h's size: the numerical integration for exponents other than 1, in single precision


@dataclass(frozen=True, slots=True)
class RoundingBound:
    """Largest |command in single precision - command in double| over the ``samples`` of a recorded run, in V.

    ``per_sample_v`` is what a sample adds to the bound ahead of the converter over the second half of them: integrators
    keep what is lost in them. It says nothing of a longer run, which has a bound of its own. ``words`` says the same in
    a sentence.
    """

    command_v: float
    samples: int
    per_sample_v: float
    words: str


def rounding_bound(of: FlightController, form: Sections, v: Vectors) -> RoundingBound:
    """The bound on what single precision does to the commands of a controller.

    Args:
        of: The controller.
        form: Its linear part.
        v: A recorded run of it.
    """
    error = errors_before_converter(of, form, v)
    largest = float(np.max(error, initial=0.0))
    command = float(np.max(behind_converter(of, np.max(error, axis=0, initial=0.0)), initial=0.0))
    growth = _growth(np.max(error, axis=1, initial=0.0))
    return RoundingBound(command, v.inputs.shape[0], growth, _words(of, command, largest, growth, v.inputs.shape[0]))


def behind_converter(of: FlightController, error_v: Floats) -> Floats:
    """The largest difference of two commands behind clip and converter, by actuator, from that ahead of them (V).

    Two numbers closer than a count fall on neighbouring counts at worst. No difference is beyond the limits' distance.

    Args:
        of: The controller, for its limits and resolution (V).
        error_v: Largest difference ahead of the clip in V, by actuator, not negative.
    """
    r = of.resolution_v
    found = error_v if r == 0.0 else (np.floor(np.minimum(error_v / r, 1e9)) + 1.0) * r
    ends = np.abs([e for e in (of.minimum_v, of.maximum_v) if math.isfinite(e)])
    rounding = 4.0 * UNIT * float(np.max(ends, initial=0.0))
    return np.asarray(np.minimum(found + rounding, of.maximum_v - of.minimum_v))


def _growth(error: Floats) -> float:
    """Rise a sample over the second half of a run, of a bound that may fluctuate."""
    half = error.size // 2
    if half == 0 or not np.all(np.isfinite(error)):
        return 0.0
    return max(0.0, float(np.max(error[half:]) - np.max(error[:half]))) / half


def _words(of: FlightController, command: float, largest: float, growth: float, samples: int) -> str:
    if largest >= of.maximum_v - of.minimum_v:
        return f"Over these {samples} samples it is not bounded: errors may grow while commands are clipped."
    where = "" if of.resolution_v == 0.0 else f" ({largest:.3g} V ahead of a converter of {of.resolution_v:.3g} V)"
    kind = "" if of.adaptation is None else f", {SIGMAS:g} times the rms of {RUNS} runs with random roundings"
    return (
        f"It stays within {command:.3g} V of double over these {samples} samples{where}{kind}; over the second half of "
        f"them that grows by {growth:.2g} V a sample."
    )


# ------------------------------------------------------------------------------------------------------ the linear part
def errors_before_converter(of: FlightController, form: Sections, v: Vectors) -> Floats:
    """Bound of the error of each command ahead of clip and converter in V, shape (samples, actuators).

    Infinite where no bound was found: errors may feed themselves while commands are clipped.

    Args:
        of: The controller, for its limits and its inverse.
        form: Its linear part.
        v: The recorded run that the bound holds for.
    """
    r = run_in_double(of, form, v.inputs)
    if of.adaptation is not None:
        return learning_errors(of, form, r, v.inputs)
    return _settled(of, form, r, *_local(form, v.inputs, r))


def errors_of_inverse(of: FlightController, form: Sections, r: Run) -> Floats:
    """The same bound where the inverse alone is in single precision: it reads the outputs of an exact linear part.

    Args:
        of: The controller, for its limits and its inverse.
        form: Its linear part.
        r: The run in double precision.
    """
    if of.adaptation is not None:
        return learning_errors(of, form, r, None)
    return _settled(of, form, r, np.zeros_like(r.states), 2.0 * UNIT * np.abs(r.outputs))


def _settled(of: FlightController, form: Sections, r: Run, states: Floats, outputs: Floats) -> Floats:
    """Errors of the commands where each sample adds these to the states and to the outputs of the linear part."""
    response = _Response(form, len(states))
    lags = 0 if of.inverse is None else of.inverse.lag_keep.size
    error, lag = np.zeros_like(r.free), np.zeros((len(states), lags))
    for _ in range(500):
        # Errors reach the states through the anti-windup where a command is clipped, or might be in single precision.
        clipped = (r.free - of.minimum_v <= error) | (of.maximum_v - r.free <= error)
        linear = response.bound(states + (clipped * error) @ np.abs(form.L).T) + outputs
        new, lag = _through_inverse(of, r, linear, lag)
        if not np.all(np.isfinite(new)) or np.max(new, initial=0.0) > of.maximum_v - of.minimum_v:
            break
        if np.max(np.abs(new - error), initial=0.0) <= 1e-5 * np.max(new, initial=0.0):
            return _HIGHER_ORDERS * new
        error = new
    return np.full_like(error, math.inf)


def _local(form: Sections, inputs: Floats, r: Run) -> tuple[Floats, Floats]:
    """What rounding in each sample adds to each state and to each output: of numbers, coefficients and operations."""
    slow = np.array(compensated_states(form), dtype=bool)
    step = np.abs(form.A - np.diag(slow.astype(float)))
    x, m, c = np.abs(r.states), np.abs(inputs), np.abs(r.excess)
    terms = np.count_nonzero(np.hstack([step, form.B, form.L]), axis=1)
    size = x @ step.T + m @ np.abs(form.B).T + c @ np.abs(form.L).T
    # Coefficient, product and reading, and the sums; a compensated sum loses a few units of its increment, and of
    # itself what is of second order.
    states = np.where(slow, (terms + 8) * UNIT * size + 4.0 * UNIT**2 * x, (terms + 4) * UNIT * size)
    gains = np.count_nonzero(np.hstack([form.C, form.D]), axis=1)
    outputs = (gains + 4) * UNIT * (x @ np.abs(form.C).T + m @ np.abs(form.D).T)
    return states, outputs


class _Response:
    """Sizes of the impulse responses from the states to the outputs, ready to be convolved."""

    def __init__(self, form: Sections, samples: int) -> None:
        self.samples, self.length = samples, 2 * samples
        self.sizes = [np.fft.rfft(np.abs(responses(row, form.A, samples)), self.length, axis=0) for row in form.C]

    def bound(self, local: Floats) -> Floats:
        """Bound of each output's error (samples, outputs) for what each sample adds to the states, ``local``."""
        pushed = np.fft.rfft(local, self.length, axis=0)
        found = [np.fft.irfft(np.sum(s * pushed, axis=1), self.length)[: self.samples - 1] for s in self.sizes]
        return np.maximum(np.vstack([np.zeros((1, len(found))), np.transpose(found)]), 0.0)


def responses(row: Floats, A: Floats, count: int) -> Floats:
    """What each state adds to an output after j samples: row A^j for j = 0, 1, ..., shape (count, states).

    The powers are found by doubling.

    Args:
        row: The output's row of C, shape (states,).
        A: The discrete system's matrix, shape (states, states).
        count: How many samples.
    """
    found, power = row[None, :], A
    while found.shape[0] < count:
        found = np.vstack([found, found @ power])
        power = power @ power
    return np.asarray(found[:count])


# ---------------------------------------------------------------------------------------------------------- the inverse
def _through_inverse(of: FlightController, r: Run, outputs: Floats, lag: Floats) -> tuple[Floats, Floats]:
    """Errors of the commands, and of the lags of creep, from those of the linear part's ``outputs``, by sample."""
    n = of.actuators
    error = outputs[:, :n] + 2.0 * UNIT * np.abs(r.free)
    if of.forward is not None and r.forward is not None:
        error += _forward_errors(of.forward, r.forward, outputs[:, -r.forward.q.shape[1] :])
    if of.inverse is None or r.inverse is None:
        return error, lag
    law, i = of.inverse, r.inverse
    target = _target_errors(law, i, outputs[:, n : 2 * n], lag)
    rate = _rate_errors(of, i, target, outputs)
    added = np.abs(law.direct) * (target + 3.0 * UNIT * np.abs(i.target))
    for e, a in enumerate(law.bouc_wen_actuator.astype(int)):
        added[:, a] += _bouc_wen_errors(law.bouc_wen[e], i, e, int(a), target[:, a], rate[:, a])
    _add_play_errors(law, i, target, rate, added)
    added += 2.0 * UNIT * np.abs(i.added)
    return error + added, _lag_errors(law, i, added)


def _forward_errors(bank: kernels.ForwardBank, f: ForwardRun, error: Floats) -> Floats:
    """What a feedforward adds to the errors of the commands, from those of what drives its elements, by sample."""
    elements = f.q.shape[1]
    q_error = error + 2.0 * UNIT * np.abs(f.q)
    before = np.vstack([np.zeros((1, elements)), q_error[:-1]])
    travel = np.diff(f.q, axis=0, prepend=0.0)
    rate = np.abs(travel) / bank.step_s
    rate_error = (q_error + before) / bank.step_s + 4.0 * UNIT * rate
    found = np.empty_like(f.q)
    for e in range(elements):
        at = (f.q[:, e], travel[:, e], rate_error[:, e], q_error[:, e])
        first = len(bank.bouc_wen)
        found[:, e] = (
            _element_errors(bank.bouc_wen[e], bank.step_s, f.h[:, e], *at)
            if e < first
            else _operator_errors(bank, e - first, rate[:, e], *at)
        )
    drives = np.abs(bank.drives)
    terms = np.count_nonzero(drives, axis=1) + 3
    return np.asarray(found @ drives.T + terms * UNIT * (np.abs(f.z) @ drives.T))


def _element_errors(
    row: Floats, step_s: float, h: Floats, q: Floats, travel: Floats, rate_error: Floats, q_error: Floats
) -> Floats:
    """Errors of d1 exp(-d2 rate) (q + bias) - d1 bias + h."""
    d1, d2, limit, bias = (row[c] for c in (kernels.D1, kernels.D2, kernels.RATE_LIMIT, kernels.BIAS))
    rate = np.clip(travel / step_s, -limit, limit)
    h_error = _memory_errors(row, h, travel, rate, rate_error, q_error)
    gain, parts = np.abs(d1) * np.exp(-d2 * rate), np.abs(q) + np.abs(bias)
    spread = 8.0 * UNIT + np.abs(d2) * (rate_error + 3.0 * UNIT * np.abs(rate))
    linear = gain * (q_error + parts * spread) + 3.0 * UNIT * np.abs(d1 * bias)
    return np.asarray(linear + h_error + 4.0 * UNIT * (gain * parts + np.abs(h)))


def _operator_errors(
    bank: kernels.ForwardBank,
    o: int,
    rate: Floats,
    q: Floats,
    travel: Floats,
    rate_error: Floats,
    q_error: Floats,
) -> Floats:
    """Errors of plays, each as wrong as its drive and threshold were at most so far, and of the polynomial."""
    widening, limit, *polynomial, reach = bank.operator[o].tolist()
    own = slice(int(bank.play_start[o]), int(bank.play_start[o + 1]))
    wide = widening * np.minimum(rate, limit) if widening else np.zeros_like(rate)
    found, size = np.zeros_like(q), np.zeros_like(q)
    for threshold, weight in zip(bank.play_threshold[own].tolist(), bank.play_weight[own].tolist(), strict=True):
        half = threshold + wide if threshold > 0.0 else 0.0 * wide
        most = np.abs(q) + half
        own_error = abs(widening) * rate_error if threshold > 0.0 else 0.0
        found += abs(weight) * np.maximum.accumulate(q_error + own_error + 6.0 * UNIT * most)
        size += abs(weight) * most
    if math.isfinite(reach):
        s, (quadratic, signed, cubic) = np.minimum(np.abs(q) / reach, 1.0), np.abs(polynomial)
        slope = (2.0 * (quadratic + signed) * s + 3.0 * cubic * s * s) / reach
        found += slope * (q_error + 3.0 * UNIT * np.abs(q)) + (quadratic + signed) * (q_error / reach) ** 2
        size += (quadratic + signed + cubic) * s * s
    return np.asarray(found + (own.stop - own.start + 6) * UNIT * size)


def _target_errors(law: InverseLaw, i: InverseRun, error: Floats, lag: Floats) -> Floats:
    found = error + 2.0 * UNIT * np.abs(i.target)
    for j, a in enumerate(law.lag_actuator.astype(int)):
        found[:, a] += np.abs(law.lag_weight[j]) * (lag[:, j] + 6.0 * UNIT * np.abs(i.lag[:, j]))
    return found


def _rate_errors(of: FlightController, i: InverseRun, target: Floats, outputs: Floats) -> Floats:
    law, n = of.inverse, of.actuators
    assert law is not None
    if not law.by_difference:
        return np.asarray(outputs[:, 2 * n : 3 * n])
    both = target + np.vstack([np.zeros((1, n)), target[:-1]])
    return np.asarray(both / of.period_s + 4.0 * UNIT * np.abs(i.rate))


def _bouc_wen_errors(row: Floats, i: InverseRun, e: int, a: int, target: Floats, rate: Floats) -> Floats:
    """Errors of (target - h + d1 bias) / (d1 exp(-d2 rate)) - bias."""
    d1, d2, limit, bias = (row[c] for c in (kernels.D1, kernels.D2, kernels.RATE_LIMIT, kernels.BIAS))
    drive_rate = np.clip(i.rate[:, a] / d1, -limit, limit)
    rate_error = rate / abs(d1) + 3.0 * UNIT * np.abs(drive_rate)
    h = i.h[:, e]
    h_error = _memory_errors(row, h, i.travel[:, e], drive_rate, rate_error, target / abs(d1))
    gain = np.abs(d1) * np.exp(-d2 * drive_rate)
    parts = np.abs(i.target[:, a]) + np.abs(h) + np.abs(d1 * bias)
    above = target + h_error + 5.0 * UNIT * parts
    spread = 8.0 * UNIT + np.abs(d2) * (rate_error + 3.0 * UNIT * np.abs(drive_rate))
    return np.asarray((above + parts * spread) / gain + 3.0 * UNIT * (np.abs(bias) + parts / gain))


def _memory_errors(
    row: Floats, h: Floats, travel: Floats, rate: Floats, rate_error: Floats, drive_error: Floats
) -> Floats:
    """Errors of h by sample: h' = a h + b travel to first order, a <= exp(-decay), b the slope dh/dq at the end.

    The drive's own error q^ - q does not add up: what it adds at one step it takes back at the next but for the change
    of its weight, so that the variation of the weights counts (summation by parts). Where a drive creeps by less than
    its error the direction is not known, and the variation is that between both; neither h goes beyond what the element
    holds, which ends the sum.
    """
    before = np.concatenate([[0.0], h[:-1]])
    grown = row[kernels.EPSILON] * np.exp(row[kernels.DELTA] * np.abs(rate))
    grown_error = np.abs(grown) * (
        6.0 * UNIT * (1.0 + row[kernels.DELTA] * np.abs(rate)) + row[kernels.DELTA] * rate_error
    )
    error_before = np.concatenate([[0.0], drive_error[:-1]])
    begin, end = _decay(row, before, travel), _decay(row, h, travel)
    keep = np.exp(-np.minimum(begin, end) * (1.0 + row[kernels.POWER]))
    reverses = np.abs(travel) <= drive_error + error_before  # it may turn round in single precision
    up, down = grown - _decay(row, h, 1.0) * h, grown + _decay(row, h, -1.0) * h  # dh/dq of a rising, a falling drive
    low = np.where(reverses, np.minimum(up, down), np.where(travel > 0.0, up, down))
    high = np.where(reverses, np.maximum(up, down), np.where(travel > 0.0, up, down))
    size = np.maximum(np.abs(low), np.abs(high))
    most = sum(np.abs(row[c]) for c in (kernels.ALPHA, kernels.BETA, kernels.GAMMA, kernels.ETA)) * np.abs(travel)
    moved = np.maximum(keep, 1.0) * (np.abs(grown * travel) + np.maximum(np.abs(before), np.abs(h)) * most)
    local = 16.0 * UNIT * moved + np.minimum(UNIT * np.abs(h), moved) + np.abs(travel) * grown_error
    local += 4.0 * UNIT * size * np.abs(travel)
    if row[kernels.POWER] != 0.0:
        local += _POWER_TOLERANCE / row[kernels.PER_SIZE] * np.minimum(1.0, most)
    added = local + error_before * _variation(keep, low, high)
    most_wrong = np.abs(h) + _held_at_most(row, float(np.max(np.abs(grown) + grown_error)))
    return np.asarray(drive_error * size + _accumulated(keep, added, most_wrong))


def _held_at_most(row: Floats, grown: float) -> float:
    """Largest |h| that drives reach from rest where |epsilon exp(delta |q'|)| is at most ``grown``; may be infinite.

    |h| grows while the drive moves to the side that epsilon gives h, and settles where the decay equals the growth.
    """
    side = math.copysign(1.0, row[kernels.EPSILON])
    decay = row[kernels.ALPHA] + side * row[kernels.BETA] - abs(side * row[kernels.GAMMA] + row[kernels.ETA])
    if decay <= 0.0:
        return math.inf
    power = float(row[kernels.POWER])
    size = 1.0 if power == 0.0 else float(row[kernels.PER_SIZE]) ** power
    return _HIGHER_ORDERS * float((grown / (decay * size)) ** (1.0 / (1.0 + power)))


def _decay(row: Floats, h: Floats, travel: Floats | float) -> Floats:
    """Decay of h (times |h / size|^(n - 1) for an exponent n) for a travel of the drive."""
    side = np.where(h >= 0.0, 1.0, -1.0)
    linear = (row[kernels.ALPHA] + side * row[kernels.GAMMA]) * np.abs(travel)
    linear = linear + (side * row[kernels.BETA] + row[kernels.ETA]) * travel
    power = row[kernels.POWER]
    return np.asarray(linear if power == 0.0 else linear * (np.abs(h) * row[kernels.PER_SIZE]) ** power)


def _variation(keep: Floats, low: Floats, high: Floats) -> Floats:
    """Largest |a[k] b[k-1] - b[k]| for b between ``low`` and ``high``."""
    low_before, high_before = np.concatenate([[0.0], low[:-1]]), np.concatenate([[0.0], high[:-1]])
    return np.asarray(np.maximum(np.abs(keep * high_before - low), np.abs(keep * low_before - high)))


def _accumulated(keep: Floats, added: Floats, most: Floats) -> Floats:
    """s[k] = keep[k] s[k-1] + added[k] from 0, but never beyond most[k]."""
    total, found = 0.0, np.empty(added.size)
    for k, (a, b, end) in enumerate(zip(keep.tolist(), added.tolist(), most.tolist(), strict=True)):
        total = min(a * total + b, end)
        found[k] = total
    return found


def _add_play_errors(law: InverseLaw, i: InverseRun, target: Floats, rate: Floats, added: Floats) -> None:
    """A play does not widen differences: it is as wrong as its input and threshold were at most so far."""
    for threshold, weight, a in zip(law.play_threshold, law.play_weight, law.play_actuator.astype(int), strict=True):
        wide = widened(law, i.rate)[:, a] if threshold > 0.0 else np.zeros(target.shape[0])
        own = np.abs(law.widening[a, 0]) * rate[:, a] if threshold > 0.0 else 0.0
        size = np.abs(i.target[:, a]) + threshold + wide
        wrong = np.maximum.accumulate(target[:, a] + own + 6.0 * UNIT * size)
        added[:, a] += np.abs(weight) * (wrong + 3.0 * UNIT * (np.abs(i.target[:, a]) + wide + threshold))


def _lag_errors(law: InverseLaw, i: InverseRun, added: Floats) -> Floats:
    """Errors of the lags of creep at the begin of each sample; in single precision they are compensated sums."""
    found = np.zeros_like(i.lag)
    for j, a in enumerate(law.lag_actuator.astype(int)):
        keep, lag = float(law.lag_keep[j]), np.abs(i.lag[:, j])
        local = (1.0 - keep) * (added[:, a] + 8.0 * UNIT * (lag + np.abs(i.added[:, a]))) + 4.0 * UNIT**2 * lag
        found[1:, j] = _accumulated(np.full(local.size, keep), local, np.full(local.size, math.inf))[:-1]
    return found
