"""The adaptive inverse of play operators: what it learns of the mirror from command and reading, for many runs."""

import numpy as np

from microrad.core.kernels.compiler import inlined, merged
from microrad.core.kernels.ensemble_records import (
    COUNT_FALLBACK,
    CYCLE,
    DEAD_ZONE,
    DELAY,
    FAST_SUM,
    FROZEN_MISFIT,
    GAIN,
    IN_USE,
    KEEP,
    KEEP_UP,
    LEARNT,
    LEAST_SIZE,
    LEAST_TRAVEL,
    LEAST_WEIGHT,
    MEAN,
    MISFIT,
    MOST_WEIGHT,
    NEXT_RECIPROCAL,
    OFFSET,
    OFFSET_LIMIT,
    PIVOT,
    PLAY,
    PLAY_FIELDS,
    PLAY_SUM,
    RECIPROCAL,
    SAMPLE,
    SCRATCH,
    SHARE,
    SIZE,
    SLOPE,
    SLOW,
    SPEED,
    STRIDE,
    SUSPECT,
    SWING,
    SWUNG,
    TAKE_UP,
    THRESHOLD,
    TRACK_FIELDS,
    VOLTS,
    WEIGHT,
)
from microrad.core.kernels.side_by_side import ROW_LENGTH, at_row


@merged
def adapt(p, s):  # type: ignore[no-untyped-def]
    """What one control sample teaches: the prediction's errors stand in ``output`` behind the rates of the targets.

    The work of an update is shared out over the samples of a cycle: the plays are looked at, the reading that belongs
    to them is judged DELAY samples later, and then one play a sample is learnt. Each actuator is a sample ahead of the
    one before, so that no sample has the work of all.
    """
    cycle, judges = np.int64(p.adaptive[0, CYCLE]), np.int64(p.adaptive[0, DELAY])
    for a in range(p.adaptive.shape[0]):
        first, last, phase = p.adaptive_start[a], p.adaptive_start[a + 1], (s.place[SAMPLE] + a) % cycle
        if phase == 0:
            _look(p, s, a, first, last)
        elif phase == judges:
            _judge(p, s, a, first, last)
        elif judges < phase <= judges + last - first:
            _learn(p, s, a, first, first + phase - judges - 1)


@inlined
def _look(p, s, a, first, last):  # type: ignore[no-untyped-def]
    """What was learnt in the last cycle comes into force, and the plays of the mirror are looked at.

    With slopes S[j] = w[0] + ... + w[j] the inverse's play j is P[j] = sum over i >= j of S[i] (p[i] - p[i+1]), where p
    are the mirror's plays. So p follows from P under the slopes so far, and P under the new ones from p.
    """
    travel, share, learnt, track = p.adaptive[a, LEAST_TRAVEL], 1.0 - p.adaptive[a, KEEP], s.learnt, s.track
    of, of_cycle = at_row(a * TRACK_FIELDS), 1.0 / p.adaptive[a, CYCLE]
    inverse, mirror = of + at_row(SCRATCH), of + at_row(SCRATCH + 1)
    play_beyond, sum_beyond = of + at_row(SCRATCH + 2), of + at_row(SCRATCH + 3)
    for r in range(ROW_LENGTH):
        pivot = track[of + at_row(PIVOT) + r]
        track[of + at_row(SLOW) + r] += pivot
        track[of + at_row(OFFSET) + r] += pivot
        track[of + at_row(PIVOT) + r] = 0.0
        track[inverse + r] = track[mirror + r] = track[play_beyond + r] = track[sum_beyond + r] = 0.0
    for j in range(last - 1, first - 1, -1):
        at = at_row(j * PLAY_FIELDS)
        for r in range(ROW_LENGTH):
            play, total = learnt[at + at_row(PLAY) + r], learnt[at + at_row(PLAY_SUM) + r]
            reciprocal = learnt[at + at_row(RECIPROCAL) + r]
            step = (play - track[play_beyond + r]) * reciprocal
            track[play_beyond + r] = play
            track[inverse + r] += learnt[at + at_row(SLOPE) + r] * step
            learnt[at + at_row(PLAY) + r] = track[inverse + r]
            track[mirror + r] += of_cycle * (total - track[sum_beyond + r]) * reciprocal
            track[sum_beyond + r] = total
            learnt[at + at_row(PLAY_SUM) + r] = 0.0
            mean = learnt[at + at_row(MEAN) + r]
            mean += share * (track[mirror + r] - mean)
            learnt[at + at_row(MEAN) + r] = mean
            swung = track[mirror + r] - mean
            learnt[at + at_row(SWUNG) + r] = swung if abs(swung) > travel else 0.0
    for j in range(first, last):
        at, below = at_row(j * PLAY_FIELDS), at_row((j if j == first else j - 1) * PLAY_FIELDS)
        gap, inner = (0.0, 0.0) if j == first else (p.adaptive_threshold[j] - p.adaptive_threshold[j - 1], 1.0)
        for r in range(ROW_LENGTH):
            threshold = inner * learnt[below + at_row(THRESHOLD) + r] + gap * learnt[below + at_row(SLOPE) + r]
            reciprocal = learnt[at + at_row(NEXT_RECIPROCAL) + r]
            learnt[at + at_row(THRESHOLD) + r] = threshold
            learnt[at + at_row(VOLTS) + r] = reciprocal - inner * learnt[below + at_row(RECIPROCAL) + r]
            learnt[at + at_row(RECIPROCAL) + r] = reciprocal


@inlined
def _judge(p, s, a, first, last):  # type: ignore[no-untyped-def]
    """The reading against what the learnt and the frozen weights predict: which is to be used, and the next update.

    Normalised least squares: w += GAIN e q / (mean of q q' and its least), with q the plays about their slow means. The
    prediction in use is right but for e; those of other weights differ from it by what these weigh in q.
    """
    keep, dead, gain = p.adaptive[a, KEEP], p.adaptive[a, DEAD_ZONE], p.adaptive[a, GAIN]
    of, of_cycle, learnt, track = at_row(a * TRACK_FIELDS), 1.0 / p.adaptive[a, CYCLE], s.learnt, s.track
    more_than_own, more_than_frozen = of + at_row(SCRATCH), of + at_row(SCRATCH + 1)
    swings, sizes = of + at_row(SCRATCH + 2), of + at_row(SCRATCH + 3)
    for r in range(ROW_LENGTH):
        track[more_than_own + r] = track[more_than_frozen + r] = track[swings + r] = track[sizes + r] = 0.0
    for j in range(first, last):
        at, frozen_weight = at_row(j * PLAY_FIELDS), p.adaptive_weight[j]
        for r in range(ROW_LENGTH):
            weight, swung = learnt[at + at_row(WEIGHT) + r], learnt[at + at_row(SWUNG) + r]
            track[more_than_own + r] += (weight - learnt[at + at_row(LEARNT) + r]) * swung
            track[more_than_frozen + r] += (weight - frozen_weight) * swung
            track[swings + r] += frozen_weight * swung
            track[sizes + r] += swung * swung
    for r in range(ROW_LENGTH):
        fast = of_cycle * track[of + at_row(FAST_SUM) + r]
        track[of + at_row(FAST_SUM) + r] = 0.0
        e, e_frozen = fast + track[more_than_own + r], fast + track[more_than_frozen + r]
        frozen, size = track[swings + r], track[sizes + r]
        e -= min(max(e, -dead), dead)
        e_frozen -= min(max(e_frozen, -dead), dead)
        misfit = keep * track[of + at_row(MISFIT) + r] + (1.0 - keep) * (e * e)
        frozen_misfit = keep * track[of + at_row(FROZEN_MISFIT) + r] + (1.0 - keep) * (e_frozen * e_frozen)
        swing = keep * track[of + at_row(SWING) + r] + (1.0 - keep) * (frozen * frozen)
        mean_size = keep * track[of + at_row(SIZE) + r] + (1.0 - keep) * size
        suspect = min(misfit, frozen_misfit) > SUSPECT * swing
        in_use = track[of + at_row(IN_USE) + r]
        comes, stays = misfit + dead * dead < TAKE_UP * frozen_misfit, misfit <= KEEP_UP * frozen_misfit
        take = 1.0 if (comes | ((in_use == 1.0) & stays)) & (not suspect) else 0.0
        s.counts[at_row(COUNT_FALLBACK) + r] += in_use * (1.0 - take)
        track[of + at_row(MISFIT) + r] = misfit
        track[of + at_row(FROZEN_MISFIT) + r] = frozen_misfit
        track[of + at_row(SWING) + r] = swing
        track[of + at_row(SIZE) + r] = mean_size
        track[of + at_row(IN_USE) + r] = take
        stride = gain * e / (max(mean_size, size) + p.adaptive[a, LEAST_SIZE])
        track[of + at_row(STRIDE) + r] = 0.0 if suspect else stride


@inlined
def _learn(p, s, a, first, j):  # type: ignore[no-untyped-def]
    """Updates one play's weight, held at 0 or above, and moves the one in use to it, or to the frozen one.

    Neither moves faster than SPEED. A change of the weights in use turns the prediction about the plays' slow means.
    """
    speed, least = p.adaptive[a, SPEED], p.adaptive[a, LEAST_WEIGHT] if j == first else 0.0
    most = p.adaptive[a, MOST_WEIGHT]
    at, of, learnt, track = at_row(j * PLAY_FIELDS), at_row(a * TRACK_FIELDS), s.learnt, s.track
    below, inner = at_row((j if j == first else j - 1) * PLAY_FIELDS + SLOPE), 0.0 if j == first else 1.0
    frozen = p.adaptive_weight[j]
    for r in range(ROW_LENGTH):
        change = min(max(track[of + at_row(STRIDE) + r] * learnt[at + at_row(SWUNG) + r], -speed), speed)
        own = min(max(learnt[at + at_row(LEARNT) + r] + change, least), most)
        weight = learnt[at + at_row(WEIGHT) + r]
        goal = own if track[of + at_row(IN_USE) + r] == 1.0 else frozen
        move = min(max(goal - weight, -speed), speed)
        track[of + at_row(PIVOT) + r] -= move * learnt[at + at_row(MEAN) + r]
        slope = weight + move + inner * learnt[below + r]
        learnt[at + at_row(LEARNT) + r] = own
        learnt[at + at_row(WEIGHT) + r] = weight + move
        learnt[at + at_row(SLOPE) + r] = slope
        learnt[at + at_row(NEXT_RECIPROCAL) + r] = 1.0 / slope


@merged
def adaptive_drive(p, s, a):  # type: ignore[no-untyped-def]
    """The drive for the target of an actuator into ``work``: play operators under the weights that are in use.

    The slow part of the prediction's error, creep and drift, is followed apart. While what was learnt is in use it is
    taken off the target; it comes in and goes out as slowly.
    """
    share, limit = p.adaptive[a, SHARE], p.adaptive[a, OFFSET_LIMIT]
    of, error, target, work = at_row(a * TRACK_FIELDS), at_row(3 * p.adaptive.shape[0] + a), s.target, s.work
    now, own = at_row(2 * a + 1), at_row(a)
    for r in range(ROW_LENGTH):
        offset, slow = s.track[of + at_row(OFFSET) + r], s.track[of + at_row(SLOW) + r]
        fast = s.output[error + r] + offset - slow
        s.track[of + at_row(FAST_SUM) + r] += fast
        slow = min(max(slow + share * fast, -limit), limit)
        offset += share * (s.track[of + at_row(IN_USE) + r] * slow - offset)
        s.track[of + at_row(SLOW) + r] = slow
        s.track[of + at_row(OFFSET) + r] = offset
        target[now + r] -= offset
        work[own + r] = 0.0
    for j in range(p.adaptive_start[a], p.adaptive_start[a + 1]):
        at, learnt = at_row(j * PLAY_FIELDS), s.learnt
        for r in range(ROW_LENGTH):
            half, q = learnt[at + at_row(THRESHOLD) + r], target[now + r]
            value = max(q - half, min(q + half, learnt[at + at_row(PLAY) + r]))
            learnt[at + at_row(PLAY) + r] = value
            learnt[at + at_row(PLAY_SUM) + r] += value
            work[own + r] += learnt[at + at_row(VOLTS) + r] * value
