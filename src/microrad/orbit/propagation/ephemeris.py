"""The orbit of an ephemeris: state vectors in TEME, interpolated between; nothing is extrapolated."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from microrad.core.arrays import Floats
from microrad.orbit.base import OrbitError, States
from microrad.orbit.earth.epoch import Epoch

SLACK_S = 1e-6
"""Rounding of times at the ends of a span."""

_TIMES_AT_ONCE = 4096  # interpolated; what they take stays in the cache of the processor


@dataclass(frozen=True, slots=True, eq=False)
class Segment:
    """State vectors in TEME, how to interpolate them, and when they may be used.

    `time_s` of shape (n,) rises; `position_m` and `velocity_m_s` have the shape (3, n). `points` of them around a time
    make its polynomial.
    """

    time_s: Floats
    position_m: Floats
    velocity_m_s: Floats
    method: str
    points: int
    start_s: float
    stop_s: float

    def states(self, time_s: Floats) -> States:
        """Interpolated states, which must lie within the state vectors; shape (3, n)."""
        position, velocity = np.empty((3, time_s.size)), np.empty((3, time_s.size))
        weigh = _hermite if self.method == "HERMITE" else _lagrange
        for start in range(0, time_s.size, _TIMES_AT_ONCE):
            part = slice(start, start + _TIMES_AT_ONCE)
            before = np.searchsorted(self.time_s, time_s[part], side="right") - 1
            first = np.clip(before - (self.points - 1) // 2, 0, self.time_s.size - self.points)
            window = first + np.arange(self.points)[:, np.newaxis]
            weights = weigh(self.time_s[window], time_s[part])
            x, v = self.position_m[:, window], self.velocity_m_s[:, window]
            for k, of in enumerate((position, velocity)):
                of[:, part] = np.einsum("pn,kpn->kn", weights[2 * k], x) + np.einsum(
                    "pn,kpn->kn", weights[2 * k + 1], v
                )
        return States(position, velocity)


def _lagrange_basis(node: Floats, time: Floats) -> tuple[Floats, Floats, Floats]:
    """Lagrange's polynomials l_j at `time`, their slopes there, and their slopes at their own nodes; (points, n)."""
    value, slope, own = np.ones_like(node), np.zeros_like(node), np.zeros_like(node)
    for j in range(len(node)):
        for i in range(len(node)):
            if i != j:
                inverse = 1.0 / (node[j] - node[i])
                factor = (time - node[i]) * inverse
                slope[j] = slope[j] * factor + value[j] * inverse
                value[j] *= factor
                own[j] += inverse
    return value, slope, own


def _lagrange(node: Floats, time: Floats) -> tuple[Floats, Floats, Floats, Floats]:
    """Weights as of `_hermite`; positions and velocities have a polynomial each."""
    value, _, _ = _lagrange_basis(node, time)
    none = np.zeros_like(value)
    return value, none, none, value


def _hermite(node: Floats, time: Floats) -> tuple[Floats, Floats, Floats, Floats]:
    """Weights of positions and velocities in the position, then in the velocity; of shape (points, n) each.

    The position is the polynomial through positions and velocities at the nodes, x(t) = sum over j of
    [1 - 2 (t - t_j) l_j'(t_j)] l_j(t)^2 x_j + (t - t_j) l_j(t)^2 v_j, and the velocity its slope.
    """
    value, slope, own = _lagrange_basis(node, time)
    since = time - node
    square, square_rate = value * value, 2.0 * value * slope
    tilt = 1.0 - 2.0 * since * own
    return tilt * square, since * square, tilt * square_rate - 2.0 * own * square, square + since * square_rate


# --------------------------------------------------------------------------------------------------------------- orbit
@dataclass(frozen=True, slots=True, eq=False)
class EphemerisOrbit:
    """The orbit of an object whose state vectors a file lists, in segments that do not overlap.

    Satisfies `Orbit`. At an instant where two segments meet, the later one holds.
    """

    name: str
    epoch: Epoch
    segments: tuple[Segment, ...]
    source: str

    @property
    def span_s(self) -> tuple[float, float]:
        """First and last usable time, in seconds of the mission; there may be gaps between segments."""
        return self.segments[0].start_s, self.segments[-1].stop_s

    def states(self, time_s: Floats) -> States:
        """States in TEME at `time_s`, of shape (3, n).

        Raises:
            OrbitError: Outside the usable times.
        """
        time = np.atleast_1d(np.asarray(time_s, dtype=np.float64))
        self._check_finite(time)
        starts = np.array([segment.start_s for segment in self.segments])
        stops = np.array([segment.stop_s for segment in self.segments])
        index = np.searchsorted(starts, time + SLACK_S, side="right") - 1
        missed = (index < 0) | (time > stops[index] + SLACK_S)
        if np.any(missed):
            worst = float(time[missed][0])
            raise self._outside(worst, worst)
        position, velocity = np.empty((3, time.size)), np.empty((3, time.size))
        for k in np.unique(index):
            segment, chosen = self.segments[k], index == k
            own = segment.states(np.clip(time[chosen], segment.start_s, segment.stop_s))
            position[:, chosen], velocity[:, chosen] = own
        if np.ndim(time_s) == 0:
            return States(position[:, 0], velocity[:, 0])
        return States(position, velocity)

    def require(self, start_s: float, end_s: float) -> None:
        """Check that the state vectors cover a part of the mission.

        Args:
            start_s: Its start, s since the epoch.
            end_s: Its end, likewise.

        Raises:
            OrbitError: When some of it has no usable state vectors.
        """
        self._check_finite(np.array([start_s, end_s]))
        first, last = self.span_s
        if start_s < first - SLACK_S or end_s > last + SLACK_S:
            raise self._outside(start_s, end_s)
        for one, two in pairwise(self.segments):
            if two.start_s - one.stop_s > SLACK_S and start_s < two.start_s - SLACK_S and end_s > one.stop_s + SLACK_S:
                raise self._outside(start_s, end_s)

    def _check_finite(self, time: Floats) -> None:
        if not np.all(np.isfinite(time)):
            raise OrbitError(f"{self.source}: a time is not a finite number; give seconds since {self.epoch.text}")

    def _outside(self, start_s: float, end_s: float) -> OrbitError:
        spans = [f"{self.epoch.utc(s.start_s)} to {self.epoch.utc(s.stop_s)}" for s in self.segments[:4]]
        listed = ", ".join(spans) + (f" and {len(self.segments) - 4} more" if len(self.segments) > 4 else "")
        wanted = self.epoch.utc(start_s) + (f" to {self.epoch.utc(end_s)}" if end_s > start_s else "")
        return OrbitError(
            f"{self.source}: the ephemeris of {self.name} may be used from {listed}, and the mission needs {wanted}; "
            "nothing is extrapolated: choose an epoch and a duration inside, or take an ephemeris that covers them"
        )
