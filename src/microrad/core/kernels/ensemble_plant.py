"""The mirrors of an ensemble, one plant step."""

from math import inf

import numpy as np

from microrad.core.kernels.compiler import compiled_loop, inlined, merged
from microrad.core.kernels.ensemble_records import (
    BANK_FIELDS,
    BANK_FORCING,
    BANK_H,
    BANK_H_BEFORE,
    BANK_Q,
    BANK_TRAVEL,
    COUNT_CLAMPED,
    DRIVE_BEFORE,
    DRIVE_FIELDS,
    DRIVE_NOW,
)
from microrad.core.kernels.hysteresis import bouc_wen_advance, clamp, polynomial
from microrad.core.kernels.records import (
    ALPHA,
    BETA,
    BIAS,
    D1,
    D2,
    DELTA,
    EPSILON,
    ETA,
    GAMMA,
    POWER,
    RATE_LIMIT,
    REACH,
    WIDENING,
    WIDENING_LIMIT,
)
from microrad.core.kernels.side_by_side import (
    NEAR_DECAY,
    NEAR_EXP,
    ROW_LENGTH,
    at_row,
    bits_of,
    near_row_exp,
    near_row_relaxation,
    row_exp,
    row_relaxation,
)


@merged
def clear_row(rows, at):  # type: ignore[no-untyped-def]
    """Set a row of runs to zero.

    Args:
        rows: Rows of runs, one behind the other, flat.
        at: Place where the row begins, see `at_row`.
    """
    for r in range(ROW_LENGTH):
        rows[at + r] = 0.0


@merged
def weigh(weights, rows, first, stride, total, at, fresh):  # type: ignore[no-untyped-def]
    """total[at:] = (or, if it is not fresh, +=) sum of weights[j] x rows[first + stride j:], a row of runs each.

    A weight of 0 costs nothing. Places are unsigned, as `at_row` gives them, so that all callers share one function.

    Returns whether the total is still to be written. The total must lie in another array than the rows.

    Args:
        weights: Weights, shape (weights,).
        rows: Rows of runs, one behind the other, flat.
        first: Place of the row that goes with the first weight.
        stride: Numbers from the row of one weight to that of the next.
        total: Rows of runs, flat, of which one is written.
        at: Place of that row.
        fresh: Whether that row has nothing yet and is written over; else the sum is added to it.
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
                    for r in range(ROW_LENGTH):
                        begun = gain * rows[source + r] + other * rows[second + r]
                        total[at + r] = begun + (near * rows[third + r] + far * rows[fourth + r])
                else:
                    for r in range(ROW_LENGTH):
                        begun = total[at + r] + (gain * rows[source + r] + other * rows[second + r])
                        total[at + r] = begun + (near * rows[third + r] + far * rows[fourth + r])
            elif fresh:
                for r in range(ROW_LENGTH):
                    total[at + r] = gain * rows[source + r] + other * rows[second + r]
            else:
                for r in range(ROW_LENGTH):
                    total[at + r] += gain * rows[source + r] + other * rows[second + r]
        elif fresh:
            for r in range(ROW_LENGTH):
                total[at + r] = gain * rows[source + r]
        else:
            for r in range(ROW_LENGTH):
                total[at + r] += gain * rows[source + r]
        fresh = False
    return fresh


@merged
def weigh_some(weights, rows, first, stride, total, at, fresh):  # type: ignore[no-untyped-def]
    """As `weigh`, without the call where all weights are 0, as most are.

    Args:
        weights: Weights, shape (weights,).
        rows: Rows of runs, one behind the other, flat.
        first: Place of the row that goes with the first weight.
        stride: Numbers from the row of one weight to that of the next.
        total: Rows of runs, flat, of which one is written.
        at: Place of that row.
        fresh: Whether that row has nothing yet and is written over; else the sum is added to it.
    """
    some = False
    for j in range(weights.size):
        some = some or weights[j] != 0.0
    return weigh(weights, rows, first, stride, total, at, fresh) if some else fresh


@merged
def sum_rows(weights, rows, first, stride, total, row):  # type: ignore[no-untyped-def]
    """A row of the total = sum of weights[j] x rows[first + stride j:]; zeros where no weight counts.

    Args:
        weights: Weights, shape (weights,).
        rows: Rows of runs, one behind the other, flat.
        first: Place of the row that goes with the first weight.
        stride: Numbers from the row of one weight to that of the next.
        total: Rows of runs, flat, of which one is written.
        row: Number of that row, from 0.
    """
    if weigh(weights, rows, first, stride, total, at_row(row), True):
        clear_row(total, at_row(row))


@compiled_loop
def add_product(weights, rows, first, stride, total):  # type: ignore[no-untyped-def]
    """total += weights @ rows, a row of runs each: two rows of the total at once, and up to four of the others.

    Args:
        weights: Weights, shape (rows of the total, rows that are weighed).
        rows: Rows of runs, one behind the other, flat.
        first: Place of the first row that is weighed.
        stride: Numbers from one of them to the next.
        total: Rows of runs, flat, another array; its first ones are added to.
    """
    count, size = weights.shape
    for i in range(0, count - 1, 2):
        a, b, at, beside = weights[i], weights[i + 1], at_row(i), at_row(i + 1)
        for j in range(0, size - 3, 4):
            a0, a1, a2, a3, b0, b1, b2, b3 = a[j], a[j + 1], a[j + 2], a[j + 3], b[j], b[j + 1], b[j + 2], b[j + 3]
            one = first + stride * np.uint64(j)
            two, three, four = one + stride, one + np.uint64(2) * stride, one + np.uint64(3) * stride
            for r in range(ROW_LENGTH):
                w, x, y, z = rows[one + r], rows[two + r], rows[three + r], rows[four + r]
                total[at + r] = (((total[at + r] + a0 * w) + a1 * x) + a2 * y) + a3 * z
                total[beside + r] = (((total[beside + r] + b0 * w) + b1 * x) + b2 * y) + b3 * z
        j, over = size - size % 4, size % 4
        one = first + stride * np.uint64(j)
        two, three = one + stride, one + np.uint64(2) * stride
        if over == 3:
            a0, a1, a2, b0, b1, b2 = a[j], a[j + 1], a[j + 2], b[j], b[j + 1], b[j + 2]
            for r in range(ROW_LENGTH):
                w, x, y = rows[one + r], rows[two + r], rows[three + r]
                total[at + r] = ((total[at + r] + a0 * w) + a1 * x) + a2 * y
                total[beside + r] = ((total[beside + r] + b0 * w) + b1 * x) + b2 * y
        elif over == 2:
            a0, a1, b0, b1 = a[j], a[j + 1], b[j], b[j + 1]
            for r in range(ROW_LENGTH):
                w, x = rows[one + r], rows[two + r]
                total[at + r] = (total[at + r] + a0 * w) + a1 * x
                total[beside + r] = (total[beside + r] + b0 * w) + b1 * x
        elif over == 1:
            a0, b0 = a[j], b[j]
            for r in range(ROW_LENGTH):
                total[at + r] += a0 * rows[one + r]
                total[beside + r] += b0 * rows[one + r]
    if count % 2 == 1:
        weigh(weights[count - 1], rows, first, stride, total, at_row(count - 1), False)


@compiled_loop
def shift_rows(weights, size, rows, first, stride):  # type: ignore[no-untyped-def]
    """rows[first + stride i:] += weights[i] @ size, in a function by itself as few calls of the loop need it.

    Args:
        weights: Weights, shape (rows that are shifted, directions).
        size: A row of runs for each direction, flat (directions x LANES).
        rows: Rows of runs, one behind the other, flat; some are added to.
        first: Place of the first row that is shifted.
        stride: Numbers from one row that is shifted to the next.
    """
    for i in range(weights.shape[0]):
        weigh_some(weights[i], size, at_row(0), at_row(1), rows, first + stride * np.uint64(i), False)


@compiled_loop
def modal_step(diagonal, coupling, x):  # type: ignore[no-untyped-def]
    """x = Ad x in place, for Ad of neighbouring pairs.

    Args:
        diagonal: Diagonal of Ad, shape (states,), of an even number.
        coupling: What Ad takes of each state's neighbour (0 of 1, 1 of 0, 2 of 3, ...), shape (states,).
        x: States, a row of runs each, flat (states x LANES); written over.
    """
    for i in range(0, diagonal.size, 2):
        keep0, cross0, keep1, cross1 = diagonal[i], coupling[i], diagonal[i + 1], coupling[i + 1]
        at = at_row(i)
        for r in range(ROW_LENGTH):
            a, b = x[at + r], x[at + at_row(1) + r]
            x[at + r] = keep0 * a + cross0 * b
            x[at + at_row(1) + r] = keep1 * b + cross1 * a


@merged
def _modal_element(diagonal, coupling, E, z, x):  # type: ignore[no-untyped-def]
    """x = Ad x + E z of the only element, in place: both in one pass over the memory."""
    for i in range(0, diagonal.size, 2):
        keep0, cross0, keep1, cross1 = diagonal[i], coupling[i], diagonal[i + 1], coupling[i + 1]
        gain0, gain1, at = E[i, 0], E[i + 1, 0], at_row(i)
        for r in range(ROW_LENGTH):
            a, b, held = x[at + r], x[at + at_row(1) + r], z[r]
            x[at + r] = keep0 * a + cross0 * b + gain0 * held
            x[at + at_row(1) + r] = keep1 * b + cross1 * a + gain1 * held


@inlined
def _small_exp(x):  # type: ignore[no-untyped-def]
    """exp(x) for |x| <= 0.02, to rounding error."""
    return 1.0 + x * (
        1.0 + x * (1.0 / 2.0 + x * (1.0 / 6.0 + x * (1.0 / 24.0 + x * (1.0 / 120.0 + x * (1.0 / 720.0)))))
    )


@compiled_loop
def _mend(rows, e, bank, z, rate_gain, power):  # type: ignore[no-untyped-def]
    """h and z of those runs whose h changes sign inside the step or decays far; of all for another exponent than 1."""
    d1, bias, at, row = rows[e, D1], rows[e, BIAS], at_row(e * BANK_FIELDS), at_row(e)
    for r in range(ROW_LENGTH):
        h, end, travel, forcing = (
            bank[at + at_row(BANK_H_BEFORE) + r],
            bank[at + at_row(BANK_H) + r],
            bank[at + at_row(BANK_TRAVEL) + r],
            bank[at + at_row(BANK_FORCING) + r],
        )
        far = abs(travel) > _near_travel(rows, e)
        if far:
            decay = _decay(rows, e, h, forcing, travel)
            end = h + (forcing - decay * h) * row_relaxation(decay)
        crosses = (bits_of(h) ^ bits_of(end)) < 0 and h * forcing < 0.0
        if far or crosses or power:
            rate = clamp(travel * rate_gain, rows[e, RATE_LIMIT])
            if crosses or power:
                end = bouc_wen_advance(h, travel, rate, rows, e)
            linear = d1 * row_exp(-rows[e, D2] * rate) * (bank[at + at_row(BANK_Q) + r] + bias) - d1 * bias
            bank[at + at_row(BANK_H) + r] = end
            z[row + r] = linear + end


@inlined
def _near_travel(rows, e):  # type: ignore[no-untyped-def]
    """Up to which travel the decay is within NEAR_DECAY. No test of the decay: the compiler rounds it as it likes."""
    most = abs(rows[e, ALPHA]) + abs(rows[e, BETA]) + abs(rows[e, GAMMA]) + abs(rows[e, ETA])
    return NEAR_DECAY / max(most, 1e-300)


@inlined
def _decay(rows, e, h, forcing, travel):  # type: ignore[no-untyped-def]
    alpha, beta, gamma, eta = rows[e, ALPHA], rows[e, BETA], rows[e, GAMMA], rows[e, ETA]
    common, split = alpha * abs(travel) + eta * travel, gamma * abs(travel) + beta * travel
    return common + split if (h if h != 0.0 else forcing) > 0.0 else common - split


@merged
def _advance_bouc_wen(rows, e, bank, q, z, rate_gain, counts):  # type: ignore[no-untyped-def]
    """BANK_Q of element e to q, exactly, for a row of runs: as `bouc_wen_step`, with a zero crossing mended by itself.

    Leaves h with what it was before, and z = d1 exp(-d2 rate) (q + bias) - d1 bias + h.
    """
    limit, delta, d2, at, row = rows[e, RATE_LIMIT], rows[e, DELTA], -rows[e, D2], at_row(e * BANK_FIELDS), at_row(e)
    d1, bias, epsilon = rows[e, D1], rows[e, BIAS], rows[e, EPSILON]
    # Several short loops: their constants stay in registers, and their chains of arithmetic overlap from run to run.
    clamped, small = np.int64(0), abs(d2) * limit <= 0.02
    for r in range(ROW_LENGTH):
        end = q[row + r]
        travel = end - bank[at + at_row(BANK_Q) + r]
        free = travel * rate_gain
        rate = min(max(free, -limit), limit)
        clamped |= bits_of(free - rate)
        grown = _small_exp(d2 * rate)
        bank[at + at_row(BANK_TRAVEL) + r] = travel
        bank[at + at_row(BANK_Q) + r] = end
        z[row + r] = d1 * grown * (end + bias) - d1 * bias
    if not small:
        for r in range(ROW_LENGTH):
            rate = min(max(bank[at + at_row(BANK_TRAVEL) + r] * rate_gain, -limit), limit)
            grown = row_exp(d2 * rate)
            z[row + r] = d1 * grown * (bank[at + at_row(BANK_Q) + r] + bias) - d1 * bias
    if clamped != 0:
        for r in range(ROW_LENGTH):
            free = bank[at + at_row(BANK_TRAVEL) + r] * rate_gain
            counts[at_row(COUNT_CLAMPED) + r] += 0.0 if free == min(max(free, -limit), limit) else 1.0
    if epsilon == 0.0:  # h stays 0
        return
    if abs(delta) * limit <= NEAR_EXP:
        for r in range(ROW_LENGTH):
            travel = bank[at + at_row(BANK_TRAVEL) + r]
            rate = min(abs(travel * rate_gain), limit)
            bank[at + at_row(BANK_FORCING) + r] = epsilon * near_row_exp(delta * rate) * travel
    else:
        for r in range(ROW_LENGTH):
            travel = bank[at + at_row(BANK_TRAVEL) + r]
            rate = min(abs(travel * rate_gain), limit)
            bank[at + at_row(BANK_FORCING) + r] = epsilon * row_exp(delta * rate) * travel
    unusual, near = np.int64(0), _near_travel(rows, e)  # the sign of the first: somewhere h changes sign or decays far
    for r in range(ROW_LENGTH):
        h, forcing, travel = (
            bank[at + at_row(BANK_H) + r],
            bank[at + at_row(BANK_FORCING) + r],
            bank[at + at_row(BANK_TRAVEL) + r],
        )
        decay = _decay(rows, e, h, forcing, travel)
        half, other = near_row_relaxation(decay)
        end = h + ((forcing - decay * h) * half) * other
        unusual |= (bits_of(h) ^ bits_of(end)) | bits_of(near - abs(travel))
        bank[at + at_row(BANK_H_BEFORE) + r] = h
        bank[at + at_row(BANK_H) + r] = end
        z[row + r] += end
    power = rows[e, POWER] != 0.0
    if unusual < 0 or power:
        _mend(rows, e, bank, z, rate_gain, power)


@inlined
def _advance_operator(p, s, o):  # type: ignore[no-untyped-def]
    """BANK_Q of operator o to q with its plays; leaves z. BANK_TRAVEL holds what widens the thresholds."""
    bank, counts, play, q, z = s.bank, s.counts, s.play, s.q, s.z
    e = p.bouc_wen.shape[0] + o
    at, row = at_row(e * BANK_FIELDS), at_row(e)
    widening, limit = p.operator[o, WIDENING], p.operator[o, WIDENING_LIMIT]
    if widening != 0.0:
        for r in range(ROW_LENGTH):
            free = abs(q[row + r] - bank[at + at_row(BANK_Q) + r]) / p.step_s
            bank[at + at_row(BANK_TRAVEL) + r] = widening * min(free, limit)
            bank[at + at_row(BANK_Q) + r] = q[row + r]
            counts[at_row(COUNT_CLAMPED) + r] += 1.0 if free > limit else 0.0
    if p.operator[o, REACH] < inf:
        for r in range(ROW_LENGTH):
            z[row + r] = polynomial(p.operator, o, q[row + r])
    else:
        clear_row(z, row)
    for j in range(p.play_start[o], p.play_start[o + 1]):
        threshold, weight, own = p.play_threshold[j], p.play_weight[j], at_row(j)
        if (widening != 0.0) & (threshold > 0.0):
            for r in range(ROW_LENGTH):
                end, half = q[row + r], threshold + bank[at + at_row(BANK_TRAVEL) + r]
                value = max(end - half, min(end + half, play[own + r]))
                play[own + r] = value
                z[row + r] += weight * value
        else:
            for r in range(ROW_LENGTH):
                end = q[row + r]
                value = max(end - threshold, min(end + threshold, play[own + r]))
                play[own + r] = value
                z[row + r] += weight * value


@inlined
def _advance_bank(p, s):  # type: ignore[no-untyped-def]
    """z of all elements for their drives q at the end of the step."""
    first_operator = p.bouc_wen.shape[0]
    for e in range(first_operator):
        _advance_bouc_wen(p.bouc_wen, e, s.bank, s.q, s.z, 1.0 / p.step_s, s.counts)
    for o in range(p.operator.shape[0]):
        _advance_operator(p, s, o)


@inlined
def _drive_bank(p, s):  # type: ignore[no-untyped-def]
    """q = F x + H z + G u of all elements, with z before the step."""
    elements = p.G.shape[0]
    for e in range(elements):
        sum_rows(p.G[e], s.drive, at_row(DRIVE_NOW), at_row(DRIVE_FIELDS), s.q, e)
    if p.feedback:
        add_product(p.F, s.x, at_row(0), at_row(1), s.q)
        add_product(p.H, s.z, at_row(0), at_row(1), s.q)


@compiled_loop
def forward_bank(p, s, output):  # type: ignore[no-untyped-def]
    """One sample of a feedforward's own hysteresis: what its elements make of their drives is added to the commands.

    Args:
        p: A `ForwardBank`.
        s: Its `ForwardState`.
        output: Commands by actuator, rows of runs, flat; added to.
    """
    _advance_bank(p, s)
    for a in range(p.drives.shape[0]):
        weigh(p.drives[a], s.z, at_row(0), at_row(1), output, at_row(a), False)


@inlined
def ensemble_plant_step(p, s):  # type: ignore[no-untyped-def]
    """One plant step behind the amplifier's: as `predict` and `plant_step`, see `Ensemble`.

    Args:
        p: An `Ensemble`, for its plant.
        s: An `EnsembleState`: its drive has what it was and what it is at the end of the step; x, y, the bank and its
            counters are taken there.
    """
    states, several = p.diagonal.size, p.rest.value.size > 0
    if several:  # before x moves
        for i in range(states):
            if p.rest.start[i] < p.rest.start[i + 1]:
                clear_row(s.x_next, at_row(i))
            for j in range(p.rest.start[i], p.rest.start[i + 1]):
                gain, source, target = p.rest.value[j], at_row(p.rest.column[j]), at_row(i)
                for r in range(ROW_LENGTH):
                    s.x_next[target + r] += gain * s.x[source + r]
    if p.G.shape[0] == 1:
        _modal_element(p.diagonal, p.coupling, p.E, s.z, s.x)
    else:
        modal_step(p.diagonal, p.coupling, s.x)
        add_product(p.E, s.z, at_row(0), at_row(1), s.x)
    if p.direct:
        add_product(p.By, s.drive, at_row(DRIVE_BEFORE), at_row(DRIVE_FIELDS), s.x)
    if several:
        for i in range(states):
            if p.rest.start[i] < p.rest.start[i + 1]:
                for r in range(ROW_LENGTH):
                    s.x[at_row(i) + r] += s.x_next[at_row(i) + r]
    _drive_bank(p, s)
    _advance_bank(p, s)
    for o in range(p.Cy.shape[0]):
        sum_rows(p.Ky[o], s.z, at_row(0), at_row(1), s.y, o)
    add_product(p.Cy, s.x, at_row(0), at_row(1), s.y)
    if p.direct:
        add_product(p.Dy, s.drive, at_row(DRIVE_NOW), at_row(DRIVE_FIELDS), s.y)
