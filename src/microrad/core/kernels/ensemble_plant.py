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
    BANK_Q_NEXT,
    BANK_TRAVEL,
    BANK_Z,
    BANK_Z_BEFORE,
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


@compiled_loop
def _add_element(before, now, bank, e, x):  # type: ignore[no-untyped-def]
    """x += before z_before + now z of element e, for columns of neighbouring pairs of states."""
    z, z_before = at_row(e * BANK_FIELDS + BANK_Z), at_row(e * BANK_FIELDS + BANK_Z_BEFORE)
    for i in range(0, before.shape[0], 2):
        a, b, c, d = before[i, e], now[i, e], before[i + 1, e], now[i + 1, e]
        if (a != 0.0) | (b != 0.0) | (c != 0.0) | (d != 0.0):
            at = at_row(i)
            for r in range(ROW_LENGTH):
                first, last = bank[z_before + r], bank[z + r]
                x[at + r] += a * first + b * last
                x[at + at_row(1) + r] += c * first + d * last


@merged
def _modal_element(diagonal, coupling, before, now, bank, x):  # type: ignore[no-untyped-def]
    """x = Ad x + before z_before + now z of the first element, in place: both in one pass over the memory."""
    z, z_before = at_row(BANK_Z), at_row(BANK_Z_BEFORE)
    for i in range(0, diagonal.size, 2):
        keep0, cross0, keep1, cross1 = diagonal[i], coupling[i], diagonal[i + 1], coupling[i + 1]
        before0, now0, before1, now1 = before[i, 0], now[i, 0], before[i + 1, 0], now[i + 1, 0]
        at = at_row(i)
        for r in range(ROW_LENGTH):
            a, b, first, last = x[at + r], x[at + at_row(1) + r], bank[z_before + r], bank[z + r]
            x[at + r] = keep0 * a + cross0 * b + before0 * first + now0 * last
            x[at + at_row(1) + r] = keep1 * b + cross1 * a + before1 * first + now1 * last


@inlined
def _small_exp(x):  # type: ignore[no-untyped-def]
    """exp(x) for |x| <= 0.02, to rounding error."""
    return 1.0 + x * (
        1.0 + x * (1.0 / 2.0 + x * (1.0 / 6.0 + x * (1.0 / 24.0 + x * (1.0 / 120.0 + x * (1.0 / 720.0)))))
    )


@compiled_loop
def _mend(rows, e, bank, at, rate_gain, power):  # type: ignore[no-untyped-def]
    """h and z of those runs whose h changes sign inside the step or decays far; of all for another exponent than 1."""
    d1, bias = rows[e, D1], rows[e, BIAS]
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
            bank[at + at_row(BANK_Z) + r] = linear + end


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
def _advance_bouc_wen(rows, e, bank, at, rate_gain, counts):  # type: ignore[no-untyped-def]
    """BANK_Q to BANK_Q_NEXT, exactly, for a row of runs: as `bouc_wen_step`, with a zero crossing mended by itself.

    Leaves h, and z = d1 exp(-d2 rate) (q + bias) - d1 bias + h, each with what it was before.
    """
    limit, delta, d2 = rows[e, RATE_LIMIT], rows[e, DELTA], -rows[e, D2]
    d1, bias, epsilon = rows[e, D1], rows[e, BIAS], rows[e, EPSILON]
    # Several short loops: their constants stay in registers, and their chains of arithmetic overlap from run to run.
    clamped, small = np.int64(0), abs(d2) * limit <= 0.02
    for r in range(ROW_LENGTH):
        q = bank[at + at_row(BANK_Q_NEXT) + r]
        travel = q - bank[at + at_row(BANK_Q) + r]
        free = travel * rate_gain
        rate = min(max(free, -limit), limit)
        clamped |= bits_of(free - rate)
        grown = _small_exp(d2 * rate)
        bank[at + at_row(BANK_TRAVEL) + r] = travel
        bank[at + at_row(BANK_Q) + r] = q
        bank[at + at_row(BANK_Z_BEFORE) + r] = bank[at + at_row(BANK_Z) + r]
        bank[at + at_row(BANK_Z) + r] = d1 * grown * (q + bias) - d1 * bias
    if not small:
        for r in range(ROW_LENGTH):
            rate = min(max(bank[at + at_row(BANK_TRAVEL) + r] * rate_gain, -limit), limit)
            grown = row_exp(d2 * rate)
            bank[at + at_row(BANK_Z) + r] = d1 * grown * (bank[at + at_row(BANK_Q) + r] + bias) - d1 * bias
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
        bank[at + at_row(BANK_Z) + r] += end
    power = rows[e, POWER] != 0.0
    if unusual < 0 or power:
        _mend(rows, e, bank, at, rate_gain, power)


@inlined
def _advance_operator(p, s, o, at):  # type: ignore[no-untyped-def]
    """BANK_Q to BANK_Q_NEXT for the plays of operator o; leaves z. BANK_TRAVEL holds what widens the thresholds."""
    bank, counts, play = s.bank, s.counts, s.play
    widening, limit = p.operator[o, WIDENING], p.operator[o, WIDENING_LIMIT]
    for r in range(ROW_LENGTH):
        q = bank[at + at_row(BANK_Q_NEXT) + r]
        free = abs(q - bank[at + at_row(BANK_Q) + r]) / p.step_s
        bank[at + at_row(BANK_TRAVEL) + r] = widening * min(free, limit) if widening != 0.0 else 0.0
        counts[at_row(COUNT_CLAMPED) + r] += 1.0 if (widening != 0.0) & (free > limit) else 0.0
        bank[at + at_row(BANK_Z_BEFORE) + r] = bank[at + at_row(BANK_Z) + r]
        bank[at + at_row(BANK_Z) + r] = 0.0
        bank[at + at_row(BANK_Q) + r] = q
    for j in range(p.play_start[o], p.play_start[o + 1]):
        threshold, weight = p.play_threshold[j], p.play_weight[j]
        wide = 1.0 if threshold > 0.0 else 0.0
        row = at_row(j)
        for r in range(ROW_LENGTH):
            q, half = bank[at + at_row(BANK_Q) + r], threshold + wide * bank[at + at_row(BANK_TRAVEL) + r]
            value = max(q - half, min(q + half, play[row + r]))
            play[row + r] = value
            bank[at + at_row(BANK_Z) + r] += weight * value
    if p.operator[o, REACH] < inf:
        for r in range(ROW_LENGTH):
            bank[at + at_row(BANK_Z) + r] += polynomial(p.operator, o, bank[at + at_row(BANK_Q) + r])


@inlined
def _advance_bank(p, s):  # type: ignore[no-untyped-def]
    """Drive of each element at the end of the step, its operator, and its output before and now."""
    first_operator = p.bouc_wen.shape[0]
    for e in range(p.G.shape[0]):
        at, row = at_row(e * BANK_FIELDS), e * BANK_FIELDS + BANK_Q_NEXT
        sum_rows(p.G[e], s.drive, at_row(DRIVE_NOW), at_row(DRIVE_FIELDS), s.bank, row)
        if p.feedback:
            weigh(p.F[e], s.x, at_row(0), at_row(1), s.bank, at_row(row), False)
        if e < first_operator:
            _advance_bouc_wen(p.bouc_wen, e, s.bank, at, 1.0 / p.step_s, s.counts)
        else:
            _advance_operator(p, s, e - first_operator, at)


@compiled_loop
def forward_bank(p, s, output, first):  # type: ignore[no-untyped-def]
    """One sample of a feedforward's own hysteresis: what its elements make of their drives is added to the commands.

    Args:
        p: A `ForwardBank`.
        s: Its `ForwardState`.
        output: Rows of runs, flat: commands by actuator, which are added to, and the drives by element.
        first: Row of the first element's drive.
    """
    actuators, elements, first_operator = p.drives.shape[0], p.drives.shape[1], p.bouc_wen.shape[0]
    for e in range(elements):
        at, source = at_row(e * BANK_FIELDS), at_row(first + e)
        for r in range(ROW_LENGTH):
            s.bank[at + at_row(BANK_Q_NEXT) + r] = output[source + r]
        if e < first_operator:
            _advance_bouc_wen(p.bouc_wen, e, s.bank, at, 1.0 / p.step_s, s.counts)
        else:
            _advance_operator(p, s, e - first_operator, at)
    for a in range(actuators):
        weigh(p.drives[a], s.bank, at_row(BANK_Z), at_row(BANK_FIELDS), output, at_row(a), False)


@inlined
def ensemble_plant_step(p, s):  # type: ignore[no-untyped-def]
    """One plant step behind the amplifier's: as `predict` and `plant_step`, for a row of runs.

    Args:
        p: An `Ensemble`, for its plant.
        s: An `EnsembleState`: its drive has what it was and what it is at the end of the step; x, y, the bank and its
            counters are taken there.
    """
    states, elements, several = p.diagonal.size, p.G.shape[0], p.rest.value.size > 0
    if several:  # before x moves
        for i in range(states):
            if p.rest.start[i] < p.rest.start[i + 1]:
                clear_row(s.x_next, at_row(i))
            for j in range(p.rest.start[i], p.rest.start[i + 1]):
                gain, source, target = p.rest.value[j], at_row(p.rest.column[j]), at_row(i)
                for r in range(ROW_LENGTH):
                    s.x_next[target + r] += gain * s.x[source + r]
    if not p.feedback:  # else the drive of an element is that of the predicted x: with z held
        _advance_bank(p, s)
    if elements > 0 and not p.feedback:
        _modal_element(p.diagonal, p.coupling, p.E0, p.E1, s.bank, s.x)
        for e in range(1, elements):
            _add_element(p.E0, p.E1, s.bank, e, s.x)
    else:
        modal_step(p.diagonal, p.coupling, s.x)
    for i in range(states):
        weigh_some(p.B0[i], s.drive, at_row(DRIVE_BEFORE), at_row(DRIVE_FIELDS), s.x, at_row(i), False)
        weigh_some(p.B1[i], s.drive, at_row(DRIVE_NOW), at_row(DRIVE_FIELDS), s.x, at_row(i), False)
        if several and p.rest.start[i] < p.rest.start[i + 1]:
            for r in range(ROW_LENGTH):
                s.x[at_row(i) + r] += s.x_next[at_row(i) + r]
    if p.feedback:
        for i in range(states):
            weigh_some(p.E_held[i], s.bank, at_row(BANK_Z), at_row(BANK_FIELDS), s.x, at_row(i), False)
        _advance_bank(p, s)
        for e in range(elements):
            _add_element(p.E_back, p.E1, s.bank, e, s.x)
    for o in range(p.Cy.shape[0]):
        fresh = weigh(p.Cy[o], s.x, at_row(0), at_row(1), s.y, at_row(o), True)
        fresh = weigh_some(p.Dy[o], s.drive, at_row(DRIVE_NOW), at_row(DRIVE_FIELDS), s.y, at_row(o), fresh)
        if weigh_some(p.Ky[o], s.bank, at_row(BANK_Z), at_row(BANK_FIELDS), s.y, at_row(o), fresh):
            clear_row(s.y, at_row(o))
