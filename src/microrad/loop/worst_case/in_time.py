"""A loop simulated from an offset, without disturbances: whether it settles or grows, beside what its poles say."""

import math
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from microrad.core.arrays import Floats
from microrad.loop.controller_study import parts
from microrad.loop.disturbance import Reference
from microrad.loop.pointing_loop.ensemble import Span
from microrad.loop.pointing_loop.linear import straightened
from microrad.loop.pointing_loop.loop import LoopController, PointingLoop, nominal_axis_gain
from microrad.loop.pointing_loop.traces import trace
from microrad.mirror.hysteresis import rest_gain, slow_gain
from microrad.mirror.model import Mirror, linearised

Course = Literal["settles", "grows"]
"""What an error does with time."""

OFFSET = 0.25
"""Offset of the start, as a share of how far the drives reach, or of what the optical sensor sees."""

TIMES, FEWEST, MOST = 1e3, 300, 20_000
"""By how much the slowest pole decays or grows in a run, and the control samples of the shortest and longest run."""

SETTLED, DECAYS = 0.01, 0.9
"""An error settles that ends below the first share of its offset, or whose last third stays so far below the middle."""


@dataclass(frozen=True, slots=True)
class InTime:
    """A loop in time, from an offset and without disturbances, noise or quantisation.

    ``theory`` is what the largest pole says, |z| over a control sample = ``pole``. ``linear`` is what the loop does
    with a gain in place of each hysteresis element and without limits, ``with_hysteresis`` with both. Each run takes
    ``seconds`` from an offset of ``offset_rad`` on each axis.
    """

    pole: float
    linear: Course
    with_hysteresis: Course
    seconds: float
    offset_rad: float

    @property
    def theory(self) -> Course:
        """What the linear theory says."""
        return "settles" if self.pole < 1.0 else "grows"

    @property
    def agrees(self) -> bool:
        """Whether both runs do what the theory says."""
        return self.linear == self.with_hysteresis == self.theory


@dataclass(frozen=True, slots=True, eq=False)
class Simulated:
    """A loop that is simulated under a controller made for it, with another mirror in its place.

    Where ``at_rest`` each element has in theory the gain of small motions about rest, else its slow gain.
    """

    loop: PointingLoop
    controller: LoopController
    at_rest: bool

    def on(self, mirror: Mirror, pole: float) -> InTime:
        """The loop on a mirror of the size of its own, from an offset.

        Args:
            mirror: The mirror, with its hysteresis.
            pole: Largest |z| of the linear loop over a control sample.
        """
        loop, period = self._from_offset(), self.loop.timing.period_s
        samples = math.log(TIMES) / max(abs(math.log(pole)), 1e-12) if pole > 0.0 else FEWEST
        seconds = period * round(min(max(samples, FEWEST), MOST))
        gains = [rest_gain(model) if self.at_rest else slow_gain(model) for model in mirror.bank]
        straight = replace(parts.without(loop, parts.LIMITS), mirror=linearised(mirror, gains))
        runs = ((straight, straightened(self.controller, loop)), (replace(loop, mirror=mirror), self.controller))
        span, offset = Span(seconds, 0.0, seed=0), loop.references[0].point_ahead_rad
        linear, full = (course(trace(each, under, span).error_rad, offset) for each, under in runs)
        return InTime(pole, linear, full, seconds, offset)

    def _from_offset(self) -> PointingLoop:
        """The loop with an offset to follow and nothing else."""
        names = {each.name for several in self.loop.disturbances for each in several}
        quiet = (*names, parts.OPTICAL_NOISE, parts.GAUGE_NOISE, parts.QUANTISATION, parts.MISALIGNMENT)
        loop = parts.without(self.loop, *quiet)
        low, high = max(loop.drive_range_v[0], loop.drive.minimum_v), min(loop.drive_range_v[1], loop.drive.maximum_v)
        offset = OFFSET * min(nominal_axis_gain(loop) * min(-low, high), loop.optical.field_of_view_rad)
        return replace(loop, references=(Reference(offset, 0.0, 1.0),) * loop.axes)


def course(error_rad: Floats, offset_rad: float) -> Course:
    """Whether an error settles or grows.

    Args:
        error_rad: The error at the control samples, shape (samples, axes).
        offset_rad: What it begins at on each axis.
    """
    size = np.max(np.abs(error_rad), axis=1)
    third = size.size // 3
    middle, last = np.max(size[third:-third]), np.max(size[-third:])
    return "settles" if last < SETTLED * offset_rad or last < DECAYS * middle else "grows"
