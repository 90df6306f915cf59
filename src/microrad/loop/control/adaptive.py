"""The adaptive inverse of play operators: what it starts from and how fast it learns, as the kernels' arrays.

The mirror's plays, thresholds fixed, have weights that are updated on line by projected normalised least squares from
command and reading; the inverse follows from the weights by the recursions of `PrandtlIshlinskii.inverted`. Sources:
Kuhnen, European Journal of Control 9 (2003) 407 (operator, its inverse, weights of at least 0); Goodwin and Sin,
Adaptive Filtering Prediction and Control (Prentice-Hall 1984), ch. 3 (projection algorithm with a dead zone and
constraints).
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from microrad.core import kernels
from microrad.core.arrays import Floats
from microrad.mirror.hysteresis import BoucWen, PrandtlIshlinskii, slow_gain

CYCLE_S = 3.2e-3
"""Time of a cycle, at least: what is learnt are means over it, so that faster motions, the loop's own, count little."""

GAIN = 0.6
"""Share of the prediction's error that an update takes away, where it is not noise."""

SLOW_HZ = 4.0
"""Below it the reading's error counts as creep and drift, which an offset follows; weights learn of what is faster."""

MEMORY_HZ = 2.0
"""Corner of the means over the cycles: of the plays, which are learnt about theirs, and of the misfits.

They are longer than the offset's, so that what was learnt stays in use where there is little to judge it by.
"""

SPEED_1_S = 8.0
"""A weight changes by at most this share of the mirror's slow gain in a second."""

DEAD_ZONE_SIGMAS = 1.0
"""Errors of the prediction within so many sigma of the gauge's noise and steps teach nothing."""

LEAST_WEIGHT = 0.5
"""Share of its first value that the weight at threshold 0, the slope behind a reversal, keeps.

The inverse's gain there is at most twice the first one: a loop with a modulus margin of 0.5 bears that.
"""

MOST_WEIGHT = 2.0
"""Largest weight over the mirror's slow gain: what readings of any size cannot take a weight beyond."""

OFFSET_SHARE = 0.25
"""Share of the drive's largest swing that creep and drift may take, as an angle at the slow gain."""


@dataclass(frozen=True, slots=True)
class Adaptation:
    """What an adaptive inverse starts from, by actuator.

    ``plays`` are those of the frozen inverse. ``noise_rad`` is the rms of a reading's noise and steps,
    ``delay_samples`` the samples between a command and the reading that tells of it, and ``swing_v`` the drive's
    largest swing.
    """

    plays: tuple[PrandtlIshlinskii, ...]
    noise_rad: float
    delay_samples: int
    swing_v: float


def adaptation(
    models: Sequence[BoucWen | PrandtlIshlinskii], noise_rad: float, delay_samples: int, swing_v: float
) -> Adaptation:
    """What an adaptive inverse of these models starts from.

    Args:
        models: Hysteresis of each actuator, as its inverse names it.
        noise_rad: Rms of a reading's noise and steps, not negative.
        delay_samples: Control samples from a command to the reading that tells of it, at least 1.
        swing_v: The drive's largest swing from its bias, V; may be infinite.

    Raises:
        ValueError: A model is no Prandtl-Ishlinskii operator of weights of at least 0 that depend on no rate.
    """
    for model in models:
        if words := cannot_learn(model):
            raise ValueError(words)
    plays = tuple(model for model in models if isinstance(model, PrandtlIshlinskii))
    return Adaptation(plays, noise_rad, delay_samples, swing_v)


def cannot_learn(model: BoucWen | PrandtlIshlinskii) -> str:
    """Why an inverse of a model cannot learn, in words; empty where it can.

    Args:
        model: Hysteresis of an actuator.
    """
    if isinstance(model, BoucWen):
        return (
            "an adaptive inverse learns the weights of play operators, and this mirror's hysteresis is a Bouc-Wen "
            "model: identify it as a Prandtl-Ishlinskii operator, or take the frozen inverse"
        )
    if model.widening_s:
        return (
            "an adaptive inverse keeps its thresholds, and those of this mirror widen with the drive's rate: "
            "identify it without widening, or take the frozen inverse"
        )
    if min(model.weights_rad_v) < 0.0:
        return (
            f"an adaptive inverse keeps every play's weight at 0 or above, and one of this mirror is "
            f"{min(model.weights_rad_v):g} rad/V: identify it with others, or take the frozen inverse"
        )
    try:
        model.inverted()
    except ValueError as error:  # it has no inverse
        return str(error)
    return ""


def adaptive_arrays(of: Adaptation | None, period_s: float) -> dict[str, Any]:
    """The adaptation as the kernel's arrays, by field of `kernels.Ensemble`; empty where there is none.

    Args:
        of: The adaptation.
        period_s: Control period.
    """
    plays = () if of is None else of.plays
    rows = np.zeros((len(plays), kernels.ADAPTIVE_COLUMNS))
    for row, model in zip(rows, plays, strict=True):
        assert of is not None
        row[:] = _settings(of, model, period_s)
    return {
        "adaptive": rows,
        "adaptive_threshold": np.array([r for model in plays for r in model.thresholds_v]),
        "adaptive_weight": np.array([w for model in plays for w in model.weights_rad_v]),
        "adaptive_start": np.cumsum([0] + [len(model.thresholds_v) for model in plays]).astype(np.int64),
    }


def cycle_samples(of: Adaptation, period_s: float) -> int:
    """Samples from one look at the plays to the next: the reading's delay, then a play a sample, or longer.

    Args:
        of: The adaptation.
        period_s: Control period.
    """
    needed = 1 + of.delay_samples + max(len(model.thresholds_v) for model in of.plays)
    return max(needed, round(CYCLE_S / period_s))


def _settings(of: Adaptation, model: PrandtlIshlinskii, period_s: float) -> Floats:
    cycle, slow, memory = cycle_samples(of, period_s), *(2.0 * math.pi * f * period_s for f in (SLOW_HZ, MEMORY_HZ))
    gain, dead = slow_gain(model), DEAD_ZONE_SIGMAS * of.noise_rad
    found = np.zeros(kernels.ADAPTIVE_COLUMNS)
    found[kernels.CYCLE], found[kernels.DELAY] = cycle, of.delay_samples
    found[kernels.GAIN], found[kernels.DEAD_ZONE] = GAIN, dead
    found[kernels.SHARE], found[kernels.KEEP] = -math.expm1(-slow), math.exp(-memory * cycle)
    found[kernels.SPEED] = SPEED_1_S * gain * cycle * period_s
    found[kernels.LEAST_SIZE] = len(model.weights_rad_v) * (dead / gain) ** 2 + 1e-300
    found[kernels.LEAST_TRAVEL] = 0.1 * dead / gain
    found[kernels.LEAST_WEIGHT] = LEAST_WEIGHT * model.weights_rad_v[0]
    found[kernels.MOST_WEIGHT] = MOST_WEIGHT * gain
    found[kernels.OFFSET_LIMIT] = OFFSET_SHARE * gain * of.swing_v
    return found


def at_the_begin(p: kernels.Ensemble) -> tuple[Floats, Floats]:
    """What an adaptive inverse has learnt at the begin: PLAY_FIELDS numbers for each play, TRACK_FIELDS an actuator.

    Args:
        p: The loop's arrays.
    """
    plays = np.zeros((p.adaptive_weight.size, kernels.PLAY_FIELDS))
    for first, last in pairwise(p.adaptive_start.tolist()):
        rows, weights = plays[first:last], p.adaptive_weight[first:last]
        slopes, gaps = np.cumsum(weights), np.diff(p.adaptive_threshold[first:last])
        rows[:, kernels.LEARNT] = rows[:, kernels.WEIGHT] = weights
        rows[:, kernels.SLOPE] = slopes
        rows[:, kernels.RECIPROCAL] = rows[:, kernels.NEXT_RECIPROCAL] = 1.0 / slopes
        rows[1:, kernels.THRESHOLD] = np.cumsum(slopes[:-1] * gaps)
        rows[:, kernels.VOLTS] = np.diff(1.0 / slopes, prepend=0.0)
    return plays, np.zeros((len(p.adaptive), kernels.TRACK_FIELDS))
