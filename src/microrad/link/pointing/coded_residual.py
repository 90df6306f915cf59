"""Coded error rate of a link under the pointing errors of simulated runs: power in time by the fall of its beam.

Power stands still over a control sample, in which there are many bits.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from microrad import link
from microrad.core.arrays import Floats
from microrad.core.intervals import Interval
from microrad.core.units import format_quantity
from microrad.link.fade_series.coded import Interleaving
from microrad.link.fade_series.codes import Convolutional, code
from microrad.link.pointing.light import Light
from microrad.link.pointing.outage import Exposure
from microrad.loop.pointing_loop.ensemble import Span, control_samples
from microrad.loop.pointing_loop.loop import PointingLoop
from microrad.loop.pointing_loop.simulated_windows import Question, Windows, half_width

_EXTRA_DB = np.array([0.0, 0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0, 13.0, 16.0, 20.0])
"""Power over what the code needs at constant power, at which the mean error ratio is found."""


@dataclass(frozen=True, slots=True)
class CodedBeam:
    """A coded link whose power falls with the pointing error as that of a Gaussian beam.

    ``on_axis_db`` is by how much the power on the axis, less what the receiver's own pointing is stated to cost, is
    above what the code needs for ``target`` at constant power. ``span_s`` is that of the interleaver, 0 without one.
    """

    light: Light
    on_axis_db: float
    code: Convolutional
    target: float
    interleaving: Interleaving
    span_s: float

    @classmethod
    def of(cls, data: link.DataLink) -> "CodedBeam":
        """That of a communication link whose table says what code it has.

        Args:
            data: The communication link.

        Raises:
            ValueError: For a link without a table on fading, and for a data rate that the receiver does not take.
        """
        table = data.table.fading
        if table is None:
            raise ValueError("the link has no code whose error rate is known: give it the table [communication.fading]")
        light = Light.of(data)
        target = table.bit_error_ratio if data.receiver is None else data.receiver.bit_error_ratio
        assert target is not None  # the table's own check
        above_db = Exposure.stated(data).on_axis_db - light.given_db
        return cls(light, above_db, code(table.code), target, table.interleaving, table.interleaver_s or 0.0)


@dataclass(frozen=True, slots=True)
class CodedResidual:
    """A coded link under simulated pointing errors.

    ``ratio`` is the mean bit error ratio at the power that is there, with the interval of 99 % from the spread between
    the runs. ``penalty_db`` is the power, over constant power on the axis, that brings the mean back to ``target``;
    infinite beyond 20 dB.
    """

    code: str
    target: float
    interleaving: Interleaving
    span_s: float
    on_axis_db: float
    ratio: Interval
    penalty_db: float


def coded_asked(beam: CodedBeam, loop: PointingLoop, span: Span) -> Question[CodedResidual]:
    """The question what a code makes of the pointing errors of runs, at their control samples.

    Windows stand behind each other, also those of a convolutional interleaver: the runs are stationary.

    Args:
        beam: The coded link.
        loop: The loop.
        span: How long a run is, what is left out at its begin, and the seed.

    Raises:
        ValueError: For an interleaver that spans more than a run is long behind its settling.
    """
    total, settle = control_samples(loop, span)
    period = loop.timing.period_s
    length = max(1, round(beam.span_s / period))
    if length > total - settle:
        left = format_quantity((total - settle) * period, "s")
        raise ValueError(
            f"the interleaver spans {format_quantity(beam.span_s, 's')}, longer than a run, of which {left} are left "
            "behind its settling: make the runs longer"
        )

    def answer(found: Sequence[Floats]) -> CodedResidual:
        own, *others = found[0].T
        mean, half = float(np.mean(own)), half_width(own)
        ratio = Interval(mean, max(mean - half, 0.0), mean + half)
        cost = _cost_db(np.array([np.mean(each) for each in others]), beam.target)
        return CodedResidual(beam.code.name, beam.target, beam.interleaving, beam.span_s, beam.on_axis_db, ratio, cost)

    return Question(lambda: [_Coded(beam, length)], answer, beam.light.end is not None)


def _cost_db(ratios: Floats, target: float) -> float:
    """Where the mean error ratio, by extra power, is at its target."""
    from scipy.interpolate import PchipInterpolator
    from scipy.optimize import brentq

    if ratios[-1] > target:
        return math.inf
    if ratios[0] <= target * (1.0 + 1e-6):
        return 0.0
    logs = np.log(np.maximum(ratios, 1e-300))
    level = PchipInterpolator(_EXTRA_DB, logs - math.log(target))
    return float(brentq(level, _EXTRA_DB[0], _EXTRA_DB[-1], xtol=1e-9))


class _Coded:
    """Mean error ratio at the power that is there and at each extra one, run by run."""

    def __init__(self, beam: CodedBeam, length: int) -> None:
        self._beam, needed = beam, beam.code.snr_for(beam.target)
        self._snr = needed * 10.0 ** (0.1 * np.array([beam.on_axis_db, *_EXTRA_DB]))
        self._windows = [Windows(length) for _ in self._snr]
        self._total: list[Floats] = [np.zeros(1) for _ in self._snr]
        self._number = 0

    def add(self, at: int, error: Floats) -> None:
        """Some control samples: see `Tally`."""
        power, code = self._beam.light.power(error), self._beam.code
        ended = 0
        for k, (snr, windows) in enumerate(zip(self._snr, self._windows, strict=True)):
            parts = np.stack(code.parts(snr * power), axis=1)
            means = windows.add(at, parts) / windows.length
            ratios = code.ratio([*np.moveaxis(means, 1, 0)])
            self._total[k] = self._total[k] + np.sum(ratios, axis=0)
            ended = len(ratios)
        self._number += ended

    @property
    def mean(self) -> Floats:
        """Mean error ratio, shape (powers, LANES)."""
        return np.array(self._total) / self._number
