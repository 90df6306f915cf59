"""Losses that pointing errors make, as shares of the time: at one end of a link, and at both ends together."""

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike

from microrad.core.arrays import Floats
from microrad.link.beams import OffAxis
from microrad.link.coupling.ends import End
from microrad.link.radial_error import Jitter, radial_steps

_MOST = 4000  # losses that are counted one by one
_PAIRS = 600  # of each end, where both are put together
_REACH, _STEP = 8.0, 0.04  # of an error whose direction counts, along each axis, in standard deviations
_DIRECTIONS = 32
_SAME_DB = 1e-9


@dataclass(frozen=True, slots=True, eq=False)
class Losses:
    """Losses in dB, rising, with the share of the time of each; together 1."""

    loss_db: Floats
    share: Floats

    @classmethod
    def of(cls, loss_db: Floats, share: Floats) -> "Losses":
        """Losses in any order; so many that they are too fine to count one by one are put together.

        Args:
            loss_db: The losses (dB).
            share: The share of the time of each.
        """
        order = np.argsort(loss_db, kind="stable")
        return _fewer(cls(loss_db[order], share[order] / np.sum(share)), _MOST)

    def beyond(self, loss_db: ArrayLike) -> Floats:
        """Share of the time with a larger loss than each; what each loss stands for lies evenly about it."""
        tail = np.cumsum(self.share[::-1])[::-1] - self.share / 2.0
        at = np.asarray(loss_db, dtype=np.float64)
        if self.loss_db.size == 1:
            return np.asarray(at < self.loss_db[0], dtype=np.float64)
        return np.interp(at, self.loss_db, tail, left=1.0, right=0.0)

    @classmethod
    def single(cls, loss_db: float) -> "Losses":
        """One loss (dB) all the time."""
        return cls(np.array([loss_db]), np.ones(1))

    def moved(self, loss_db: float) -> "Losses":
        """The losses with one more (dB), which is there all the time."""
        return Losses(self.loss_db + loss_db, self.share)

    @property
    def mean_db(self) -> float:
        """Loss of the mean power."""
        least = float(self.loss_db[0])
        return least - 10.0 * math.log10(float(self.share @ 10.0 ** ((least - self.loss_db) / 10.0)))


def _fewer(losses: Losses, most: int) -> Losses:
    """At most so many losses: neighbours put together, with their mean."""
    if losses.loss_db.size <= most:
        return losses
    first = np.linspace(0, losses.loss_db.size, most + 1)[:-1].astype(int)
    together = np.add.reduceat(losses.share, first)
    there = together > 0.0
    return Losses((np.add.reduceat(losses.share * losses.loss_db, first)[there] / together[there]), together[there])


@dataclass(frozen=True, slots=True, eq=False)
class BothEnds:
    """Independent losses at the two ends of a link; what is lost is their sum in decibels."""

    sent: Losses
    received: Losses

    def beyond(self, loss_db: float) -> float:
        """Share of the time with a larger loss than one."""
        few, many = sorted((self.sent, self.received), key=lambda each: each.loss_db.size)
        return float(few.share @ many.beyond(loss_db - few.loss_db))

    def quantile_db(self, exceeded: float) -> float:
        """Loss (dB) that is exceeded for a share of the time, above 0."""
        from scipy.optimize import brentq

        low, high = (float(self.sent.loss_db[at] + self.received.loss_db[at]) for at in (0, -1))
        if high - low < _SAME_DB or self.beyond(low) <= exceeded:
            return low
        return float(brentq(lambda loss: self.beyond(loss) - exceeded, low, high + _SAME_DB, xtol=_SAME_DB))

    @property
    def mean_db(self) -> float:
        """Loss of the mean power."""
        return self.sent.mean_db + self.received.mean_db

    @property
    def sum(self) -> Losses:
        """The losses of both, so many that few are alike put together."""
        sent, received = (_fewer(each, _PAIRS) for each in (self.sent, self.received))
        loss = np.add.outer(sent.loss_db, received.loss_db)
        return Losses.of(loss.ravel(), np.multiply.outer(sent.share, received.share).ravel())


@lru_cache(maxsize=64)  # most rows of a campaign share their receiver
def of_jitter(end: End, jitter: Jitter) -> Losses:
    """Losses of an end of the link under a jitter of the receiving telescope, beyond that without any error.

    Args:
        end: What takes the light.
        jitter: Bias and rms of the pointing error about each axis (rad); about x first.
    """
    if end.is_round:
        return of_radii(end, *radial_steps(jitter))
    (x, of_x), (y, of_y) = map(_normal, jitter.bias_rad, jitter.rms_rad)
    both_x, both_y = np.meshgrid(x, y)
    return _beyond_axis(end, both_x.ravel(), both_y.ravel(), np.multiply.outer(of_y, of_x).ravel())


def of_radii(end: End, radius_rad: Floats, share: Floats) -> Losses:
    """Losses of an end under radial errors that come from each direction alike, beyond that without any error.

    Args:
        end: What takes the light.
        radius_rad: The errors (rad).
        share: The share of the time of each.
    """
    if end.is_round:
        return _beyond_axis(end, radius_rad, np.zeros(1), share)
    angle = 2.0 * math.pi * np.arange(_DIRECTIONS) / _DIRECTIONS
    x, y = (np.multiply.outer(radius_rad, each).ravel() for each in (np.cos(angle), np.sin(angle)))
    return _beyond_axis(end, x, y, np.repeat(share / _DIRECTIONS, _DIRECTIONS))


def of_beam(fall: OffAxis, radius_rad: Floats, share: Floats) -> Losses:
    """Losses of a beam under radial errors; behind a side lobe nothing is gained.

    Args:
        fall: How the beam falls off.
        radius_rad: The errors (rad), in any order.
        share: The share of the time of each.
    """
    order = np.argsort(radius_rad, kind="stable")
    return Losses.of(np.maximum.accumulate(fall.loss_db(radius_rad[order])), share[order])


def _beyond_axis(end: End, x_rad: Floats, y_rad: Floats, share: Floats) -> Losses:
    return Losses.of(end.loss_db(x_rad, y_rad) - end.loss_db(0.0), share)


def _normal(bias: float, rms: float) -> tuple[Floats, Floats]:
    """Errors about one axis and their shares."""
    if rms == 0.0:
        return np.array([bias]), np.ones(1)
    deviate = np.arange(-_REACH, _REACH + _STEP / 2.0, _STEP)
    share = np.exp(-0.5 * deviate**2)
    return bias + rms * deviate, share / np.sum(share)
