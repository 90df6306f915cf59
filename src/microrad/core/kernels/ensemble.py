"""An ensemble of closed loops: disturbances, sensors, controllers, statistics."""

import numpy as np

from microrad.core.kernels.adaptive import adapt, adaptive_drive
from microrad.core.kernels.compiler import compiled_loop, inlined, merged
from microrad.core.kernels.ensemble_plant import (
    clear_row,
    ensemble_plant_step,
    forward_bank,
    modal_step,
    shift_rows,
    sum_rows,
    weigh,
    weigh_some,
)
from microrad.core.kernels.ensemble_records import (
    BIN_OFFSET,
    BIN_SHIFT,
    BINS,
    COUNT_CLAMPED,
    COUNT_INVERSE_CLAMPED,
    COUNT_LOST,
    COUNT_OUTSIDE,
    COUNT_SATURATED,
    COUNT_SLEW,
    COUNTING,
    DRIVE_BEFORE,
    DRIVE_FIELDS,
    DRIVE_HIGH,
    DRIVE_LOW,
    DRIVE_NOW,
    LANES,
    SAMPLE,
    SENSOR_PURPOSE,
    STEP,
    ForwardState,
)
from microrad.core.kernels.hysteresis import bouc_wen_advance
from microrad.core.kernels.loop import quantised
from microrad.core.kernels.random_numbers import gaussians
from microrad.core.kernels.records import (
    BIAS,
    COMMAND_MAX,
    COMMAND_MIN,
    D1,
    D2,
    FOLLOW,
    RATE_LIMIT,
    RESOLUTION,
    SLEW_STEP,
    WIDENING,
    WIDENING_LIMIT,
)
from microrad.core.kernels.side_by_side import ROW_LENGTH, at_row, bits_of, copy_rows, row_exp, take_rows


@inlined
def _ensemble_amplifier(p, s, due):  # type: ignore[no-untyped-def]
    """The drive at the end of the plant step; ``due`` is the row of commands that it moves towards."""
    actuators = p.actuator.shape[0]
    for a in range(actuators):
        follow, slew = p.actuator[a, FOLLOW], p.actuator[a, SLEW_STEP]
        low, high = p.actuator[a, DRIVE_LOW], p.actuator[a, DRIVE_HIGH]
        at, source = at_row(a * DRIVE_FIELDS), at_row(due * actuators + a)
        drive, command, counts = s.drive, s.command, s.counts
        for r in range(ROW_LENGTH):
            before = drive[at + at_row(DRIVE_NOW) + r]
            free = (command[source + r] - before) * follow
            move = min(max(free, -slew), slew)
            now = before + move
            drive[at + at_row(DRIVE_BEFORE) + r] = before
            drive[at + at_row(DRIVE_NOW) + r] = now
            counts[at_row(COUNT_SLEW) + r] += 0.0 if move == free else 1.0
            counts[at_row(COUNT_OUTSIDE) + r] += 1.0 if (now < low) | (now > high) else 0.0


@inlined
def _ensemble_disturbance(p, s, shift):  # type: ignore[no-untyped-def]
    """The disturbance one plant step on, from four steps' worth of random numbers at a time."""
    step = s.place[STEP]
    _draw_sources(p, s)
    k = step - shift.first_sample * p.steps_per_sample
    if 0 <= k < shift.step.shape[0]:
        shift_rows(shift.step[k], shift.size, s.gauss, at_row(step % 4), at_row(4))
    _shape(p, s)


@inlined
def _draw_sources(p, s):  # type: ignore[no-untyped-def]
    """The random numbers of the disturbances' sources, where those of the last four steps are used up."""
    step = s.place[STEP]
    if step % 4 == 0:
        for w in range(p.purpose.size):
            gaussians(p.seed, s.first_run[0], p.purpose[w], step // 4, s.gauss, at_row(4 * w))


@inlined
def _shape(p, s):  # type: ignore[no-untyped-def]
    """The disturbance one plant step on, from the random numbers at hand."""
    step = s.place[STEP]
    modal_step(p.shaping_diagonal, p.shaping_coupling, s.shaping)
    for i in range(p.shaping_diagonal.size):
        weigh_some(p.shaping_noise[i], s.gauss, at_row(step % 4), at_row(4), s.shaping, at_row(i), False)
    for i in range(p.shaping_output.shape[0]):
        sum_rows(p.shaping_output[i], s.shaping, at_row(0), at_row(1), s.disturbance, i)


@inlined
def _line_of_sight_error(p, s, i, begin, end, share):  # type: ignore[no-untyped-def]
    """e = reference + disturbance - y of axis i, the references at a share of the way from ``begin`` to ``end``."""
    at, error, disturbance, y = at_row(i), s.error, s.disturbance, s.y
    reference = begin[0] + share * (end[0] - begin[0])
    for o in range(p.optics.shape[1]):
        gain, source = -p.optics[i, o], at_row(o)
        if o == 0 and begin.size > 1:
            for r in range(ROW_LENGTH):
                own = begin[r] + share * (end[r] - begin[r])
                error[at + r] = own + disturbance[at + r] + gain * y[source + r]
        elif o == 0:
            for r in range(ROW_LENGTH):
                error[at + r] = reference + disturbance[at + r] + gain * y[source + r]
        elif gain != 0.0:
            for r in range(ROW_LENGTH):
                error[at + r] += gain * y[source + r]


@inlined
def _statistics(p, s):  # type: ignore[no-untyped-def]
    """What a plant step adds to the squares and the largest radial error; ``work`` is left with its square."""
    work, error, square, largest = s.work, s.error, s.sum_square, s.largest
    for i in range(p.optics.shape[0]):
        at = at_row(i)
        for r in range(ROW_LENGTH):
            e = error[at + r]
            square[at + r] += e * e
            work[r] = e * e + (work[r] if i > 0 else 0.0)
    for r in range(ROW_LENGTH):
        largest[r] = max(largest[r], work[r])


@merged
def _count_radial(error, axes, work, total, histogram):  # type: ignore[no-untyped-def]
    """What a control sample adds to the sums and to the histogram of the radial error, whose square is in ``work``."""
    for r in range(at_row(axes)):
        total[r] += error[r]
    for r in range(ROW_LENGTH):
        place = (bits_of(work[r]) >> BIN_SHIFT) - BIN_OFFSET
        histogram[r, min(max(place, 0), BINS - 1)] += np.int32(1)


@inlined
def _draw_sensors(p, s):  # type: ignore[no-untyped-def]
    """The random numbers of a control sample's readings."""
    for word in range(0, p.optics.shape[0] + p.optics.shape[1], 4):
        purpose = np.uint64(SENSOR_PURPOSE + word // 4)
        gaussians(p.seed, s.first_run[0], purpose, s.place[SAMPLE], s.sensor_gauss, at_row(word))


@merged
def _measure(p, s, reference, shift, drawn):  # type: ignore[no-untyped-def]
    """The readings m of a control sample: optical, gauge, reference. ``drawn`` is its first row of what is drawn."""
    axes, outputs, sample = p.optics.shape[0], p.optics.shape[1], s.place[SAMPLE]
    noisy = p.gauge_noise > 0.0
    for i in range(axes):
        noisy = noisy or p.optical_noise[i] > 0.0
    if noisy and s.drawn.size > 0:
        take_rows(s.drawn, drawn, s.sensor_gauss, axes + outputs)
    elif noisy:
        _draw_sensors(p, s)
    k = sample - shift.first_sample
    if noisy and 0 <= k < shift.sample.shape[0]:
        shift_rows(shift.sample[k], shift.size, s.sensor_gauss, at_row(0), at_row(1))
    if sample % p.sensor_every == 0:
        _measure_optical(p, s)
    for o in range(outputs):
        at, y, gauss, measured = at_row(axes + o), s.y, s.sensor_gauss, s.measured
        for r in range(ROW_LENGTH):
            measured[at + r] = y[at_row(o) + r] + p.gauge_noise * gauss[at + r]
        if p.gauge_resolution > 0.0:
            for r in range(ROW_LENGTH):
                measured[at + r] = quantised(measured[at + r], p.gauge_resolution)
    own, known = np.uint64(1 if reference.shape[1] > 1 else 0), reference.shape[0] - axes
    for i in range(axes):
        for r in range(ROW_LENGTH):
            s.measured[at_row(axes + outputs + i) + r] = reference[known + i, own * r]


@inlined
def _measure_optical(p, s):  # type: ignore[no-untyped-def]
    """A new reading of the delayed error where the spot is inside the field of view; elsewhere the last one stays."""
    axes, measured, work, ring, gauss = p.optics.shape[0], s.measured, s.work, s.error_ring, s.sensor_gauss
    length = p.sensor_delay_steps + 1
    due = at_row((s.place[STEP] + 1) % length * axes)
    clear_row(work, at_row(0))
    for i in range(axes):
        for r in range(ROW_LENGTH):
            e = ring[due + at_row(i) + r]
            work[r] += e * e
    seen = p.field_of_view * p.field_of_view
    for i in range(axes):
        noise = p.optical_noise[i]
        for r in range(ROW_LENGTH):
            new = ring[due + at_row(i) + r] + noise * gauss[at_row(i) + r]
            measured[at_row(i) + r] = new if work[r] <= seen else measured[at_row(i) + r]
        if p.optical_resolution > 0.0:
            for r in range(ROW_LENGTH):
                measured[at_row(i) + r] = quantised(measured[at_row(i) + r], p.optical_resolution)
    for r in range(ROW_LENGTH):
        s.counts[at_row(COUNT_LOST) + r] += 0.0 if work[r] <= seen else 1.0


@merged
def _ensemble_inverse(p, s):  # type: ignore[no-untyped-def]
    """Adds to each actuator's output what the inverse makes of its target, as `inverse_drive`, at the rate given."""
    actuators, output, target = p.actuator.shape[0], s.output, s.target
    adaptive = p.adaptive.shape[0] > 0
    if adaptive:
        adapt(p, s)
    for a in range(actuators):
        now = at_row(2 * a + 1)
        for r in range(ROW_LENGTH):
            target[at_row(2 * a) + r] = target[now + r]
            target[now + r] = output[at_row(actuators + a) + r]
        for j in range(p.inverse_lag_keep.size):
            if p.inverse_lag_actuator[j] == a:
                for r in range(ROW_LENGTH):
                    target[now + r] -= p.inverse_lag_weight[j] * s.inverse_lag[at_row(j) + r]
        if adaptive:
            adaptive_drive(p, s, a)
        else:
            for r in range(ROW_LENGTH):
                s.work[at_row(a) + r] = p.inverse_direct[a] * target[now + r]
    for e in range(p.inverse_bouc_wen.shape[0]):
        _inverse_bouc_wen(p, s, e, np.int64(p.inverse_bouc_wen_actuator[e]))
    for a in range(actuators):
        if not adaptive:
            _inverse_plays(p, s, a)
        for r in range(ROW_LENGTH):
            output[at_row(a) + r] += s.work[at_row(a) + r]
    for j in range(p.inverse_lag_keep.size):
        keep, drive, lag = p.inverse_lag_keep[j], at_row(p.inverse_lag_actuator[j]), s.inverse_lag
        for r in range(ROW_LENGTH):
            lag[at_row(j) + r] = keep * lag[at_row(j) + r] + (1.0 - keep) * s.work[drive + r]


@inlined
def _inverse_bouc_wen(p, s, e, a):  # type: ignore[no-untyped-def]
    rows, actuators = p.inverse_bouc_wen, p.actuator.shape[0]
    d1, d2, bias, limit = rows[e, D1], rows[e, D2], rows[e, BIAS], rows[e, RATE_LIMIT]
    for r in range(ROW_LENGTH):
        before, now = s.target[at_row(2 * a) + r], s.target[at_row(2 * a + 1) + r]
        free = s.output[at_row(2 * actuators + a) + r] / d1
        rate = min(max(free, -limit), limit)
        s.counts[at_row(COUNT_INVERSE_CLAMPED) + r] += 0.0 if rate == free else 1.0
        h = bouc_wen_advance(s.inverse[at_row(e) + r], (now - before) / d1, rate, rows, e)
        s.inverse[at_row(e) + r] = h
        s.work[at_row(a) + r] += (now - h + d1 * bias) / (d1 * row_exp(-d2 * rate)) - bias


@inlined
def _inverse_plays(p, s, a):  # type: ignore[no-untyped-def]
    widening, limit = p.inverse_widening[a, WIDENING], p.inverse_widening[a, WIDENING_LIMIT]
    actuators, now = p.actuator.shape[0], at_row(2 * a + 1)
    for j in range(p.inverse_play_threshold.size):
        if p.inverse_play_actuator[j] == a:
            threshold, weight = p.inverse_play_threshold[j], p.inverse_play_weight[j]
            wide = widening if threshold > 0.0 else 0.0
            for r in range(ROW_LENGTH):
                half = threshold + (wide * min(abs(s.output[at_row(2 * actuators + a) + r]), limit) if wide else 0.0)
                q = s.target[now + r]
                value = max(q - half, min(q + half, s.inverse_play[at_row(j) + r]))
                s.inverse_play[at_row(j) + r] = value
                s.work[at_row(a) + r] += weight * value
    if widening != 0.0:
        for r in range(ROW_LENGTH):
            beyond = abs(s.output[at_row(2 * actuators + a) + r]) > limit
            s.counts[at_row(COUNT_INVERSE_CLAMPED) + r] += 1.0 if beyond else 0.0


@inlined
def _control(p, s, length):  # type: ignore[no-untyped-def]
    """One sample of the controller: readings to commands, with inverse, clip and anti-windup."""
    states, actuators = p.A.shape[0], p.actuator.shape[0]
    for i in range(p.C.shape[0]):
        fresh = weigh(p.C[i], s.xc, at_row(0), at_row(1), s.output, at_row(i), True)
        if weigh(p.D[i], s.measured, at_row(0), at_row(1), s.output, at_row(i), fresh):
            clear_row(s.output, at_row(i))
    if p.feedforward:
        _ensemble_inverse(p, s)
    if p.forward.drives.shape[1] > 0:
        counts = s.counts[at_row(COUNT_INVERSE_CLAMPED - COUNT_CLAMPED) :]
        drives = s.output[at_row(p.C.shape[0] - p.forward.drives.shape[1]) :]
        own = ForwardState(drives, s.forward_z, s.forward_bank, s.forward_play, counts)
        forward_bank(p.forward, own, s.output)
    for i in range(states):
        fresh = weigh(p.A[i], s.xc, at_row(0), at_row(1), s.xc_next, at_row(i), True)
        if weigh(p.B[i], s.measured, at_row(0), at_row(1), s.xc_next, at_row(i), fresh):
            clear_row(s.xc_next, at_row(i))
    row = s.place[SAMPLE] % length
    for a in range(actuators):
        low, high = p.actuator[a, COMMAND_MIN], p.actuator[a, COMMAND_MAX]
        resolution, at = p.actuator[a, RESOLUTION], at_row(row * actuators + a)
        command, output, counts = s.command, s.output, s.counts
        for r in range(ROW_LENGTH):
            v = output[at_row(a) + r]
            clipped = min(max(v, low), high)
            output[at_row(a) + r] = clipped - v
            command[at + r] = clipped
            counts[at_row(COUNT_SATURATED) + r] += 0.0 if clipped == v else 1.0
        if resolution > 0.0:
            for r in range(ROW_LENGTH):
                command[at + r] = quantised(command[at + r], resolution)
    for i in range(states):
        weigh(p.L[i], s.output, at_row(0), at_row(1), s.xc_next, at_row(i), False)
    copy_rows(s.xc_next, s.xc, 0, states)


@compiled_loop
def _record(k, rows, width, trace, channel):  # type: ignore[no-untyped-def]
    """Rows into the channels of a trace from ``channel`` on; returns the channel behind them."""
    for row in range(width):
        for r in range(ROW_LENGTH):
            trace[k, channel + row, r] = rows[at_row(row) + r]
    return channel + width


@compiled_loop
def draw_loop(p, s, samples, drawn):  # type: ignore[no-untyped-def]
    """What LANES runs draw over some control samples, sample by sample.

    For each: a random number for every reading (optical by axis, then gauge by output), then at every plant step's end
    the disturbance by axis. Loops alike in their disturbances, clock, axes and outputs draw the same. Of the state the
    disturbance and the place go on, and nothing else.

    Args:
        p: The `Ensemble`.
        s: Its `EnsembleState`.
        samples: How many control samples.
        drawn: Rows of runs, flat; the first samples x (axes + outputs + steps per sample x axes) are written. Random
            numbers have an rms of 1, disturbances are in rad.
    """
    axes, steps, words = p.optics.shape[0], p.steps_per_sample, p.optics.shape[0] + p.optics.shape[1]
    row = 0
    for _ in range(samples):
        _draw_sensors(p, s)
        copy_rows(s.sensor_gauss, drawn, row, words)
        row += words
        for _ in range(steps):
            if p.shaping_diagonal.size > 0:
                _draw_sources(p, s)
                _shape(p, s)
            copy_rows(s.disturbance, drawn, row, axes)
            row += axes
            s.place[STEP] += 1
        s.place[SAMPLE] += 1


@compiled_loop
def ensemble_loop(p, s, reference, residual, trace, shift):  # type: ignore[no-untyped-def]
    """Advance LANES runs over the control samples of ``reference``, linear between them.

    Statistics are taken where ``place`` says so: squares and the largest error at the end of every plant step, sums and
    the histogram at the end of each control sample; the counters go on all the time. The states are left at the end, so
    that a following call continues.

    Args:
        p: The `Ensemble`.
        s: Its `EnsembleState`; the random numbers that the runs begin with are drawn already.
        reference: Reference of each axis, rad, shape (samples + 1, axes, 1), or with LANES in place of the 1 where each
            run has its own. Of twice as many axes the controller knows the second half alone.
        residual: Line-of-sight error at the begin of each sample, rad, shape (samples, axes, LANES); written if it has
            rows.
        trace: What there is once a sample has measured, shape (samples, channels, LANES): disturbance by axis, drive
            before and now actuator by actuator, the plant's outputs, readings; written if it has rows.
        shift: The `Shift` that is added to the random numbers; `UNSHIFTED` for none.
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
            ensemble_plant_step(p, s)
            if s.drawn.size > 0:
                take_rows(s.drawn, drawn + words + j * axes, s.disturbance, axes)
            elif p.shaping_diagonal.size > 0:
                _ensemble_disturbance(p, s, shift)
            s.place[STEP] += 1
            share = (j + 1) / steps
            for i in range(axes):
                _line_of_sight_error(p, s, i, reference[k, i], reference[k + 1, i], share)
            if p.sensor_delay_steps > 0 or j == steps - 1:
                copy_rows(s.error, s.error_ring, s.place[STEP] % ring_length * axes, axes)
            if s.place[COUNTING] == 1:
                _statistics(p, s)
        s.place[SAMPLE] += 1
        if s.place[COUNTING] == 1:
            _count_radial(s.error, axes, s.work, s.sum, s.histogram)
