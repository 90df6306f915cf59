"""Intervals of confidence: Student's t, Clopper and Pearson's of a share, and that of a share seen in clusters."""

import math
from dataclasses import dataclass

import numpy as np

from microrad.core.arrays import Floats


@dataclass(frozen=True, slots=True)
class Interval:
    """A mean with the ends of its interval of confidence."""

    value: float
    low: float
    high: float


def binomial_band(hits: Floats, trials: Floats, confidence: float) -> tuple[Floats, Floats]:
    """Ends of Clopper and Pearson's interval, for real numbers of hits and trials, too.

    Args:
        hits: numbers of hits (n,).
        trials: numbers of trials (n,).
        confidence: that of the interval, within (0, 1).
    """
    from scipy.special import betaincinv

    beyond, missed = (1.0 - confidence) / 2.0, np.maximum(trials - hits, 0.0)
    low = np.where(hits > 0.0, betaincinv(np.maximum(hits, 1e-300), missed + 1.0, beyond), 0.0)
    high = np.where(missed > 0.0, betaincinv(hits + 1.0, np.maximum(missed, 1e-300), 1.0 - beyond), 1.0)
    return low, high


def student(confidence: float, freedom: float) -> float:
    """Half width of the interval of Student's t.

    Args:
        confidence: that of the interval, within (0, 1).
        freedom: degrees of freedom, inf for the normal distribution.
    """
    from scipy.special import stdtrit

    return float(stdtrit(freedom, 0.5 + confidence / 2.0))


def counted(clusters: int, confidence: float) -> float:
    """Share of the independent trials that is counted where so few clusters tell of their number; 1 for one.

    Args:
        clusters: Number of clusters.
        confidence: That of the interval, within (0, 1).

    Source: E. L. Korn and B. I. Graubard, Survey Methodology 24 (1998) 193.
    """
    return (student(confidence, math.inf) / student(confidence, clusters - 1)) ** 2 if clusters > 1 else 1.0


def clustered_band(shares: Floats, each: int, confidence: float) -> tuple[float, float]:
    """Ends of the interval of a share that was seen in independent clusters of as many trials each.

    Clopper and Pearson's of as many independent trials as would know the share as well as the spread between the
    clusters does, at most all trials: E. L. Korn and B. I. Graubard, Survey Methodology 24 (1998) 193. Where all trials
    hit, or none, there is no spread, and they count as independent. One cluster leaves all between 0 and 1.

    Args:
        shares: Share of the trials that hit, by cluster (clusters,).
        each: Trials in a cluster.
        confidence: That of the interval, within (0, 1).
    """
    clusters, share = shares.size, float(np.mean(shares))
    if clusters < 2:
        return 0.0, 1.0
    trials = float(clusters * each)
    variance = float(np.var(shares, ddof=1)) / clusters
    if variance > 0.0:
        trials = min(trials, share * (1.0 - share) / variance * counted(clusters, confidence))
    low, high = binomial_band(np.array([share * trials]), np.array([trials]), confidence)
    return float(low[0]), float(high[0])
