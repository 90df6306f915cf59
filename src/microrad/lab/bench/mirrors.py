"""The mirrors that the virtual bench plays: its own, which is none of the models that are fitted, and the paper's two.

The bench's own mirror, from the drive u at the amplifier's input to the angle y:

    v' = (u - v) / tau, |v'| at most the slew              amplifier; u is held between the samples of the converter
    q = v - s asinh(r / r0), r the rate of v, smoothed     domain walls that lag with the logarithm of the rate
    x = w0 v + sum of w(p) play_p[q]                       60 play operators with a smooth density
    S = x + kappa x^2                                      saturation: the two branches of a loop differ
    y = G S + g sum over lags of lag[S]                    Eq. 2 without its drift pair, gain 1; creep in log time

G is slow against neither converter nor amplifier, so it is solved on a finer grid than the samples. Eq. 2 and Eq. 3 are
those of SPIE 11852, 118523B, as printed, in mrad and volts.
"""

import math
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from microrad.core.arrays import Complexes, Floats
from microrad.core.kernels import bouc_wen_response, play_response

EQ2_NUMERATOR = (1.979e11, 7.051e13, 2.973e13)
EQ2_DENOMINATOR = (1.0, 2.15e4, 3.737e8, 2.615e12, 8.489e14, 1.829e14)
EQ3 = (0.089, -2.96e-7, -0.048, 0.00047, 38.421, 34.635)  # d1, d2, epsilon, delta, alpha, beta

FINE_STEP_S = 2.5e-6
"""Longest step of the bench's own mirror while its drive moves: halving it moves no sample by 0.02 microradian."""

_CHUNK = 1 << 15  # fine steps advanced together: the plays of a chunk stay in the cache's reach
_SETTLED = 25.0  # time constants after which nothing fast is left (e^-25)


@dataclass(frozen=True, slots=True)
class Amplifier:
    """First-order corner and slew limit of the amplifier, both seen from its input."""

    bandwidth_hz: float
    slew_v_s: float

    @property
    def time_constant_s(self) -> float:
        """Of the first-order response."""
        return 1.0 / (2 * math.pi * self.bandwidth_hz)


@dataclass(frozen=True, slots=True)
class BenchMirror:
    """The bench's own mirror, in mrad, volts and seconds (see the module's equations).

    The numbers are those of a soft piezo stack in a mirror like the paper's: 0.079 mrad/V for small and 0.091 for large
    slow drives, a slow loop of 12 V that is open by 6 % of its height, 1 % of creep a decade.
    """

    direct_mrad_v: float = 0.0790
    play_mrad_v: float = 0.0210  # all operators together
    operators: int = 60
    threshold_most_v: float = 7.5
    threshold_scale_v: float = 2.2  # of the density r exp(-(r / scale)^1.3) + a floor: few tiny, few large ones
    curvature_1_mrad: float = -0.012
    viscous_v: float = 0.12
    viscous_rate_v_s: float = 300.0
    viscous_smoothing_s: float = 5e-4
    creep_share_decade: float = 0.010
    creep_first_s: float = 0.01
    creep_decades: int = 7
    lags_per_decade: int = 2

    @property
    def thresholds_v(self) -> Floats:
        """Half widths of the play operators."""
        return np.asarray(np.arange(1, self.operators + 1) * (self.threshold_most_v / self.operators), dtype=np.float64)

    @property
    def weights_mrad_v(self) -> Floats:
        """Weights of the play operators."""
        r = self.thresholds_v / self.threshold_scale_v
        density = (0.15 + r) * np.exp(-(r**1.3))
        return np.asarray(self.play_mrad_v * density / density.sum())

    @property
    def lag_times_s(self) -> Floats:
        """Time constants of the creep, evenly spaced in their logarithm."""
        count = self.creep_decades * self.lags_per_decade
        return np.asarray(self.creep_first_s * 10.0 ** ((np.arange(count) + 0.5) / self.lags_per_decade))

    def saturated(self, extension_mrad: Floats) -> Floats:
        """S (mrad) of the mirror for the sum (mrad) of direct part and plays."""
        return extension_mrad * (1.0 + self.curvature_1_mrad * extension_mrad)

    def at_rest(self, rest_v: float) -> float:
        """S (mrad) after a decaying sine about `rest_v`, which leaves every play operator in its middle."""
        extension = (self.direct_mrad_v + self.play_mrad_v) * rest_v
        return float(self.saturated(np.array(extension)))


# --------------------------------------------------------------------------------------------------- Eq. 2 and Eq. 3
def linear_output(drive: Floats, rest_v: float, rate_hz: float) -> Floats:
    """Output (mrad) of the linear Eq. 2 as printed, settled at the rest drive before the record.

    The drive is held between samples, as a converter does.

    Args:
        drive: Drive of one axis, in V, shape (samples,).
        rest_v: Drive before the record, in V, at which the mirror has settled.
        rate_hz: Sample rate, in Hz.
    """
    poles, residues = _modes(EQ2_NUMERATOR, EQ2_DENOMINATOR)
    moved, previous = np.append(drive[:-1] - rest_v, 0.0), np.zeros(poles.size, dtype=complex)
    response = _modal(poles, residues, moved, 1.0 / rate_hz, previous, held=True)[0]
    gain = EQ2_NUMERATOR[-1] / EQ2_DENOMINATOR[-1]
    return np.asarray(gain * rest_v + np.concatenate([[0.0], response[: drive.size - 1]]))


def bouc_wen_output(drive: Floats, rest_v: float, rate_hz: float) -> Floats:
    """Output (mrad) of Eq. 3 as printed, with h = 0 before the record.

    The drive is a straight line between samples: Eq. 3 has no answer to the steps of a converter, whose rate has no
    bound.

    Args:
        drive: Drive of one axis, in V, shape (samples,).
        rest_v: Drive before the record, in V.
        rate_hz: Sample rate, in Hz.
    """
    row = np.array([*EQ3, math.inf, 0.0])
    return np.asarray(bouc_wen_response(np.append(rest_v, drive), 1.0 / rate_hz, row, 0.0)[0][1:])


# ------------------------------------------------------------------------------------------------------ the own mirror
def bench_output(
    drive: Floats,
    rest_v: float,
    rate_hz: float,
    amplifier: Amplifier,
    mirror: BenchMirror | None = None,
    fine_step_s: float = FINE_STEP_S,
) -> Floats:
    """Angle of the bench's own mirror (mrad) at the samples of a drive that is held between them.

    While the drive moves the mirror is stepped finely: the amplifier's answer within a sample is an exponential, and
    the dynamics behind it have their resonance at 2.5 kHz, so a straight line from sample to sample would not do. Where
    drive and amplifier stand still a sample is a step, which is exact.

    Args:
        drive: The drive (V), shape (samples,).
        rest_v: Where the mirror rests before the first sample, see `BenchMirror.at_rest`.
        rate_hz: Samples per second.
        amplifier: The amplifier before the mirror.
        mirror: The mirror; by default that of the bench.
        fine_step_s: Longest step while the drive moves.
    """
    from scipy.signal import lfilter

    mirror = mirror or BenchMirror()
    run = _MirrorState(mirror, amplifier, rest_v, 1.0 / rate_hz)
    volts = run.amplified(drive)
    fine = max(1, math.ceil(run.sample_s / fine_step_s - 1e-9))
    fast, strain = np.empty(drive.size), np.empty(drive.size)
    for start, stop, moving in _stretches(_moving(drive, rest_v, run)):
        steps = fine if moving else 1
        for first in range(start, stop, max(1, _CHUNK // steps)):
            part = slice(first, min(stop, first + max(1, _CHUNK // steps)))
            fast[part], strain[part] = run.advance(drive[part], volts[part], steps)
    settled = mirror.at_rest(rest_v)
    creep = np.zeros(drive.size)
    moved = strain - settled
    for time_s in mirror.lag_times_s:
        decay, before, end = _straight_line(np.array(-1.0 / time_s), run.sample_s)
        creep += lfilter([end / time_s, before / time_s], [1.0, -decay], moved)
    return np.asarray(fast + settled + mirror.creep_share_decade / mirror.lags_per_decade * creep)


class _MirrorState:
    """The state of the bench's own mirror on its way through a record."""

    def __init__(self, mirror: BenchMirror, amplifier: Amplifier, rest_v: float, sample_s: float) -> None:
        self.mirror, self.amplifier, self.sample_s, self.rest_v = mirror, amplifier, sample_s, rest_v
        self.thresholds, self.weights = mirror.thresholds_v, mirror.weights_mrad_v
        self.poles, self.residues = _fast_modes()
        self.smooth = rest_v  # the drive behind the smoothing of its rate
        self.plays = np.full(mirror.operators, rest_v)
        self.settled = mirror.at_rest(rest_v)
        self.moved = 0.0  # S about the settled one
        self.modes = np.zeros(self.poles.size, dtype=complex)
        self.before_v = rest_v
        self.output = 0.0

    def amplified(self, drive: Floats) -> Floats:
        """The amplifier's output (V at its input) at each sample; the command of a sample acts behind it."""
        from scipy.signal import lfilter

        tau, slew = self.amplifier.time_constant_s, self.amplifier.slew_v_s
        decay = math.exp(-self.sample_s / tau)
        held = drive[:-1] - self.rest_v
        volts = self.rest_v + np.append(0.0, lfilter([1.0 - decay], [1.0, -decay], held))
        if np.any(np.abs(drive - volts) > slew * tau):  # somewhere the slew limit holds: sample by sample
            value = self.rest_v
            for k, command in enumerate(drive[:-1].tolist()):
                value = float(_approach(value, command, self.sample_s, tau, slew))
                volts[k + 1] = value
        return volts

    def advance(self, drive: Floats, volts: Floats, steps: int) -> tuple[Floats, Floats]:
        """Go over a part of the record in steps finer than its samples.

        Returned are the fast output about the settled one, and S, both at the samples (shape (samples,)).

        Args:
            drive: The command at each sample, in V, shape (samples,).
            volts: The amplifier's output at each sample, in V at its input, shape (samples,).
            steps: Steps in each sample.
        """
        from scipy.signal import lfilter

        mirror, step_s = self.mirror, self.sample_s / steps
        since = np.arange(1, steps + 1, dtype=np.float64) * step_s
        tau, slew = self.amplifier.time_constant_s, self.amplifier.slew_v_s
        v = _approach(volts[:, None], drive[:, None], since, tau, slew).ravel()
        decay, start, end = _straight_line(np.array(-1.0 / mirror.viscous_smoothing_s), step_s)
        b = np.array([end, start]) / mirror.viscous_smoothing_s
        state = [float(decay) * self.smooth + b[1] * self.before_v]
        smooth = lfilter(b, [1.0, -float(decay)], v, zi=state)[0]
        rate = (v - smooth) / mirror.viscous_smoothing_s
        q = v - mirror.viscous_v * np.arcsinh(rate / mirror.viscous_rate_v_s)
        plays = play_response(q, self.thresholds, self.plays)
        moved = mirror.saturated(mirror.direct_mrad_v * v + plays @ self.weights) - self.settled
        output, modes = _modal(self.poles, self.residues, np.append(self.moved, moved), step_s, self.modes, held=False)
        fast = np.append(self.output, output[steps - 1 :: steps])
        strain = np.append(self.moved, moved[steps - 1 :: steps]) + self.settled
        self.before_v, self.smooth, self.plays = float(v[-1]), float(smooth[-1]), plays[-1].copy()
        self.moved, self.modes, self.output = float(moved[-1]), modes, float(output[-1])
        return fast[:-1], strain[:-1]


def _approach(
    value: Floats | float, command: Floats | float, time_s: Floats | float, tau: float, slew: float
) -> Floats:
    """First-order approach to a held command, with its rate limited: a straight line, then an exponential."""
    gap = np.subtract(command, value)
    side, size = np.sign(gap), np.abs(gap)
    ramp_s = np.maximum(size / slew - tau, 0.0)
    left = np.minimum(size, slew * tau) * np.exp(-np.maximum(time_s - ramp_s, 0.0) / tau)
    return np.asarray(np.where(time_s < ramp_s, value + side * slew * time_s, command - side * left))


def _moving(drive: Floats, rest_v: float, run: _MirrorState) -> NDArray[np.bool_]:
    """Samples in which the drive moves, or has moved so lately that amplifier and smoothing have not settled."""
    changed = np.flatnonzero(np.diff(drive, prepend=rest_v) != 0.0)
    longest = max(run.amplifier.time_constant_s, run.mirror.viscous_smoothing_s)
    slewing = float(np.abs(np.diff(drive, prepend=rest_v)).max(initial=0.0)) / run.amplifier.slew_v_s
    settle = math.ceil((_SETTLED * longest + slewing) / run.sample_s)
    edges = np.zeros(drive.size + 1, dtype=np.int64)
    np.add.at(edges, changed, 1)
    np.add.at(edges, np.minimum(changed + settle, drive.size), -1)
    return np.cumsum(edges[:-1]) > 0


def _stretches(moving: NDArray[np.bool_]) -> list[tuple[int, int, bool]]:
    """Runs of equal values: first sample, the one behind the last, and the value."""
    edges = [0, *(np.flatnonzero(np.diff(moving)) + 1).tolist(), moving.size]
    return [(a, b, bool(moving[a])) for a, b in pairwise(edges) if b > a]


# ------------------------------------------------------------------------------------------------------------ dynamics
def _modes(numerator: tuple[float, ...], denominator: tuple[float, ...]) -> tuple[Complexes, Complexes]:
    """Poles with an imaginary part of at least 0, and residues; those of a complex pair are doubled, to take Re of."""
    poles = np.roots(denominator).astype(complex)
    residues = [
        np.polyval(numerator, p) / denominator[0] / np.prod(p - np.delete(poles, i)) for i, p in enumerate(poles)
    ]
    kept = poles.imag >= 0.0
    return poles[kept], (np.asarray(residues) * np.where(poles.imag > 0.0, 2.0, 1.0))[kept]


@lru_cache(maxsize=1)
def _fast_modes() -> tuple[Complexes, Complexes]:
    """Eq. 2 without its slowest pole and zero, which are drift, and with gain 1 at rest."""
    poles = sorted(np.roots(EQ2_DENOMINATOR), key=abs)[1:]
    zeros = sorted(np.roots(EQ2_NUMERATOR), key=abs)[1:]
    numerator, denominator = np.real(np.poly(zeros)), np.real(np.poly(poles))
    gain = denominator[-1] / numerator[-1]
    return _modes(tuple(gain * numerator), tuple(denominator))


def _straight_line(pole: NDArray[np.inexact], step_s: float) -> tuple[NDArray[np.inexact], ...]:
    """Exact step of x' = pole x + u for u linear over it: x[k+1] = decay x[k] + start u[k] + end u[k+1]."""
    z = pole * step_s
    decay = np.exp(z)
    # (e^z - 1 - z) / z^2 cancels for small z; its series does not
    series = 0.5 + z * (1 / 6 + z * (1 / 24 + z * (1 / 120 + z * (1 / 720 + z / 5040))))
    ramp = np.where(np.abs(z) < 0.01, series, (np.expm1(z) - z) / np.where(z == 0, 1.0, z) ** 2)
    held = np.expm1(z) / pole
    return decay, held - step_s * ramp, step_s * ramp


def _modal(
    poles: Complexes, residues: Complexes, values: Floats, step_s: float, state: Complexes, *, held: bool
) -> tuple[Floats, Complexes]:
    """Output and modes of a sum of residue / (s - pole) after each step but the first value's own.

    `values` are the input from the start of the first step on: straight lines between them, or held.
    """
    from scipy.signal import lfilter

    output, last = np.zeros(values.size - 1), np.empty_like(state)
    decays, starts, ends = _straight_line(poles, step_s)
    if held:
        starts, ends = starts + ends, 0.0 * ends
    for i, residue in enumerate(residues):
        decay, start, end = decays[i], starts[i], ends[i]
        if poles[i].imag == 0.0:
            decay, start, end = decay.real, start.real, end.real
        first = [decay * (state[i] if poles[i].imag else state[i].real) + start * values[0]]
        mode = lfilter([end, start], [1.0, -decay], values[1:], zi=first)[0]
        output += (residue * mode).real if poles[i].imag else residue.real * mode
        last[i] = mode[-1]
    return output, last
