"""What of a pointing error counts in a time window: the indices of ECSS-E-ST-60-10C, and what an exposure sees.

All is of stationary motion about zero. In a window of length T the mean counts or what is left beside it, between two
windows the difference of their means. On a one-sided density, with x = 2 pi f T, the mean has the weight
2 (1 - cos x) / x^2, what is left 1 minus that, and the difference of two means a time s apart 2 (1 - cos 2 pi f s)
times the first.

For x' = A x + B w, y = C x, with the stationary covariance P, the same follows without an integral from
phi_k(A T) P C', phi_k(z) = sum z^n / (n + k)!, all of them blocks of one matrix exponential (A. H. Al-Mohy and
N. J. Higham, SIAM J. Sci. Comput. 33, 488, 2011). Displacement, smear and jitter are those of M. E. Pittelkau and
W. G. McKinley, Opt. Eng. 55, 063108 (2016): mean, slope times T and residual of a line through the window by least
squares.
"""

import math
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import ArrayLike

from microrad.core import lti
from microrad.core.arrays import Complexes, Floats
from microrad.loop.disturbance.records import Disturbance, above_zero, covariance, rising

Sides = Literal["one", "two"]
"""Whether a density holds all power above 0 Hz, or half of it there and half below."""

IndexKind = Literal["APE", "MPE", "RPE", "PDE", "PRE", "AKE", "MKE", "RKE"]
"""Absolute, mean and relative pointing error, drift and reproducibility of the mean; and the same of what is known."""

_POINTING = {"AKE": "APE", "MKE": "MPE", "RKE": "RPE"}
_SPACED = ("PDE", "PRE")
_SMALL = 1e-4  # part of the whole below which a difference loses digits, and another form is taken
_SOUND = 1e7  # condition of the modes, above which they are not taken
_ONCE: Floats = 1.0 / np.cumprod(np.arange(1.0, 15.0))  # 1 / (k + 1)!, for series up to 0.5
_CHAIN = 7  # functions phi_1 to phi_7
_CALM = 3.0  # turns of the longest time, up to which a weight is integrated as it is
_PRECISE: dict[str, Any] = {"epsabs": 0.0, "epsrel": 1e-10, "limit": 400}


@dataclass(frozen=True, slots=True)
class ErrorIndex:
    """What of a pointing error counts, as ECSS-E-ST-60-10C 3.2 defines it.

    Of an error APE takes all, MPE its mean over a window, RPE what is left beside that mean within it, PDE the
    difference of the means of two windows in one observation period, and PRE that of two windows in different ones;
    AKE, MKE and RKE are APE, MPE and RPE of the error in what is known of the pointing.

    Args:
        kind: Which one.
        window_s: Length of the window (s), above 0; None for APE and AKE.
        spacing_s: From the begin of the first window to the begin of the second (s), above 0; None but for PDE and PRE.

    Raises:
        ValueError: For another kind, and for a time that its definition has not, or lacks.
    """

    kind: IndexKind
    window_s: float | None = None
    spacing_s: float | None = None

    def __post_init__(self) -> None:
        """Check the times against the definition."""
        if self.kind not in get_args(IndexKind):
            raise ValueError(f'no error index "{self.kind}"; give one of {", ".join(get_args(IndexKind))}')
        wanted = {"window_s": self.takes not in ("APE",), "spacing_s": self.takes in _SPACED}
        for name, needed in wanted.items():
            value = getattr(self, name)
            if needed and value is None:
                raise ValueError(f"{self.kind} needs {name}: give the time in s")
            if not needed and value is not None:
                raise ValueError(f"{self.kind} has no {name}: leave it out")
            if value is not None:
                above_zero(value, f"{name} of {self.kind}", "s")

    @property
    def takes(self) -> str:
        """The index of a pointing error that is the same of what it is taken of: MPE for MKE."""
        return _POINTING.get(self.kind, self.kind)

    @property
    def cosines(self) -> tuple[tuple[float, float], ...]:
        """Of the mean, or of the difference of two, the weight as a sum of factor cos(2 pi f time) / f^2, time in s."""
        if self.window_s is None:
            return ()
        window, scale = self.window_s, 2.0 / (2.0 * math.pi * self.window_s) ** 2
        if self.spacing_s is None:
            return (scale, 0.0), (-scale, window)
        apart = self.spacing_s
        sides = (scale, abs(window - apart)), (scale, window + apart)
        return (2.0 * scale, 0.0), (-2.0 * scale, window), (-2.0 * scale, apart), *sides

    def weight(self, freq_hz: ArrayLike) -> Floats:
        """Share of a density that counts, shape (frequencies,); up to 4 where two means differ.

        Args:
            freq_hz: Frequencies (Hz), shape (frequencies,).
        """
        freq = np.atleast_1d(np.asarray(freq_hz, dtype=float))
        if self.window_s is None:
            return np.ones(freq.shape)
        mean = np.sinc(freq * self.window_s) ** 2
        if self.takes == "MPE":
            return np.asarray(mean)
        if self.spacing_s is not None:
            return np.asarray(4.0 * np.sin(np.pi * freq * self.spacing_s) ** 2 * mean)
        return _left(np.pi * freq * self.window_s)

    def rational_weight(self, freq_hz: ArrayLike) -> Floats:
        """The weight in the rational form after Ott, which linear tools take in its place.

        With s = 2 pi i f T and D = s^2 + 6 s + 12 it is that of the filter 2 (s + 6) / D for the mean, and of
        s (s + sqrt 12) / D for what is left.

        Args:
            freq_hz: Frequencies (Hz), shape (frequencies,).

        Raises:
            ValueError: For a difference of two means, which has no rational form.
        """
        s = 2j * np.pi * np.atleast_1d(np.asarray(freq_hz, dtype=float)) * (self.window_s or 0.0)
        high, middle, low = self._numerator
        return np.asarray(np.abs((high * s * s + middle * s + low) / (s * s + 6.0 * s + 12.0)) ** 2)

    @property
    def _numerator(self) -> tuple[float, float, float]:
        """Of the rational filter, over s^2 + 6 s + 12."""
        if self.takes in _SPACED:
            raise ValueError(f"{self.kind} has no rational form: a difference of two means has a delay in it")
        rows = {"APE": (1.0, 6.0, 12.0), "MPE": (0.0, 2.0, 12.0), "RPE": (1.0, math.sqrt(12.0), 0.0)}
        return rows[self.takes]


def _left(half: Floats) -> Floats:
    """1 - (sin x / x)^2, by its series where the difference loses digits."""
    near = np.abs(half) < 0.1
    x = np.where(near, half, 0.0) ** 2
    series = x / 3.0 * (1.0 - x * 2.0 / 15.0 * (1.0 - x / 14.0 * (1.0 - x * 2.0 / 45.0)))
    return np.asarray(np.where(near, series, 1.0 - np.sinc(half / np.pi) ** 2))


# ------------------------------------------------------------------------------------------------------------- motions
def windowed_rms(disturbance: Disturbance, index: ErrorIndex) -> float:
    """What an index takes of a disturbance (rad rms), exactly, lines included.

    Args:
        disturbance: The disturbance of one axis.
        index: What counts of it.
    """
    motion = Motion.of(lti.StateSpace(disturbance.A, disturbance.B, disturbance.C, _nothing(disturbance)))
    lines = (0.5 * each.amplitude_rad**2 * float(index.weight(each.freq_hz)[0]) for each in disturbance.lines)
    return math.sqrt(max(motion.windowed(index).item(), 0.0) + math.fsum(lines))


def _nothing(disturbance: Disturbance) -> Floats:
    return np.zeros((1, disturbance.B.shape[1]))


@dataclass(frozen=True, slots=True)
class Motion:
    """A stationary motion by its modes: the covariance of y(t + lag) with y(t) is the sum of e^(rate lag) pair.

    Args:
        rate: Poles (rad/s), shape (modes,).
        pair: What each mode adds to the covariance at no lag (rad^2), shape (modes, outputs, outputs).
        system: x' = A x + B w, y = C x.
        sound: Whether the modes keep their digits: they nearly coincide elsewhere, and the system itself is taken.
    """

    rate: Complexes
    pair: Complexes
    system: lti.StateSpace
    sound: bool

    @classmethod
    def of(cls, system: lti.StateSpace) -> "Motion":
        """The motion of a stable system under white noise of unit two-sided density at each input.

        Args:
            system: x' = A x + B w, y = C x; without a direct term, whose variance is infinite.
        """
        A, B, C = system.A, system.B, system.C
        rate, modes = np.linalg.eig(A) if A.size else (np.zeros(0, complex), np.zeros((0, 0), complex))
        if A.size and np.linalg.cond(modes) > _SOUND:
            return cls(rate, np.zeros((0, len(C), len(C)), complex), system, False)
        fed = np.linalg.solve(modes, B.astype(complex))
        together = -(fed @ fed.conj().T) / (rate[:, None] + rate.conj())
        left, right = C @ modes, together @ modes.conj().T @ C.T
        return cls(rate, np.einsum("im,mj->mij", left, right), system, True)

    def windowed(self, index: ErrorIndex) -> Floats:
        """Covariance that an index takes of it (rad^2), shape (outputs, outputs).

        Args:
            index: What counts of it.
        """
        if not self.sound:
            return _windowed(self.system.A, self.system.B, self.system.C, index)
        window, spacing, scale = index.window_s, index.spacing_s, 1.0
        if window is None:
            return _both_halves(self.pair.sum(axis=0).real)
        if spacing is not None and spacing < window:  # what both windows share is not in the difference of their sums
            window, spacing, scale = spacing, window, (spacing / window) ** 2
        left, once = _less_than_whole(self.rate * window)
        if index.takes == "RPE":
            weight = left
        elif spacing is None:
            weight = 1.0 - left
        else:
            weight = 2.0 * scale * (1.0 - left - np.exp(self.rate * (spacing - window)) * once**2)
        return _both_halves(np.tensordot(weight, self.pair, 1).real)


def _both_halves(matrix: Floats) -> Floats:
    return np.asarray(0.5 * (matrix + matrix.T))


def _less_than_whole(z: Complexes) -> tuple[Complexes, Complexes]:
    """1 - 2 (e^z - 1 - z) / z^2 and (e^z - 1) / z, by series where the differences lose digits."""
    near = np.abs(z) < 0.5
    far = np.where(near, 1.0, z)
    once = np.expm1(far) / far
    powers = np.where(near, z, 0.0)[:, None] ** np.arange(len(_ONCE) - 1)
    return (
        np.where(near, -2.0 * powers[:, 1:] @ _ONCE[2:], 1.0 - 2.0 * (once - 1.0) / far),
        np.where(near, powers @ _ONCE[:-1], once),
    )


def _windowed(A: Floats, B: Floats, C: Floats, index: ErrorIndex) -> Floats:
    """Covariance that an index takes of y = C x with x' = A x + B w, by matrix exponentials."""
    b = covariance(A, B) @ C.T
    whole = _both_halves(C @ b)
    if index.window_s is None:
        return whole
    window, spacing = index.window_s, index.spacing_s
    if spacing is not None and spacing < window:  # what both windows share is not in the difference of their sums
        return (spacing / window) ** 2 * _windowed(A, B, C, replace(index, window_s=spacing, spacing_s=window))
    phi = _phi(A, b, window)
    mean = 2.0 * _both_halves(C @ phi[2])
    if spacing is not None:
        return 2.0 * (mean - _both_halves(_lagged(A, b, C, window, spacing)))
    if index.takes == "MPE":
        return mean
    if np.trace(whole - mean) > _SMALL * np.trace(whole):
        return np.asarray(whole - mean)
    step = A * window
    return np.asarray(window / 6.0 * (C @ B) @ (C @ B).T - 2.0 * _both_halves(C @ step @ step @ phi[4]))


def _lagged(A: Floats, b: Floats, C: Floats, window: float, spacing: float) -> Floats:
    """Covariance of the means of two windows of which one begins when the other has ended, or later."""
    from scipy.linalg import expm

    steps = _phi(A, np.eye(A.shape[0]), window, 1)[1]
    return np.asarray(C @ expm(A * (spacing - window)) @ steps @ steps @ b)


def _phi(A: Floats, b: Floats, span: float, count: int = _CHAIN) -> dict[int, Floats]:
    """phi_1 to phi_count of A times a span, each times b, from one matrix exponential."""
    from scipy.linalg import expm

    n, m = b.shape
    whole = np.zeros((n + count * m, n + count * m))
    whole[:n, :n], whole[:n, n : n + m] = A * span, b
    whole[n : n + (count - 1) * m, n + m :] = np.eye((count - 1) * m)
    row = expm(whole)[:n, n:]
    return {k: row[:, (k - 1) * m : k * m] for k in range(1, count + 1)}


def rational_rms(disturbance: Disturbance, index: ErrorIndex) -> float:
    """The same by the rational form of the weight (rad rms), exactly: from the variance behind its filter.

    Args:
        disturbance: The disturbance of one axis.
        index: What counts of it.

    Raises:
        ValueError: For a difference of two means, which has no rational form.
    """
    if index.window_s is None:
        return disturbance.rms_rad
    high, middle, low = index._numerator
    lines = (0.5 * each.amplitude_rad**2 * float(index.rational_weight(each.freq_hz)[0]) for each in disturbance.lines)
    n, per_s = disturbance.A.shape[0], 1.0 / index.window_s
    filter_A = per_s * np.array([[-6.0, -12.0], [1.0, 0.0]])
    fed = per_s * np.vstack([disturbance.C, np.zeros((1, n))])
    A = np.block([[disturbance.A, np.zeros((n, 2))], [fed, filter_A]])
    B = np.vstack([disturbance.B, np.zeros((2, disturbance.B.shape[1]))])
    C = np.hstack([high * disturbance.C, np.array([[middle - 6.0 * high, low - 12.0 * high]])])
    return math.sqrt(float((C @ covariance(A, B) @ C.T).item()) + math.fsum(lines))


# ------------------------------------------------------------------------------------------------------------ exposures
@dataclass(frozen=True, slots=True)
class Exposure:
    """Covariances of what a motion does in an exposure (rad^2), each of shape (outputs, outputs).

    A line through the motion by least squares over the exposure has the ``displacement`` in its middle and the
    ``smear`` from its begin to its end; ``jitter`` is what the line leaves, averaged over the exposure.
    """

    displacement_rad2: Floats
    smear_rad2: Floats
    jitter_rad2: Floats


def exposure(system: lti.StateSpace, exposure_s: float) -> Exposure:
    """What a stationary motion does in an exposure, exactly.

    Args:
        system: x' = A x + B w, y = C x (rad) with w white of unit two-sided density; stable, without a direct term.
        exposure_s: Length of the exposure (s), above 0.

    Raises:
        ValueError: For a system that is not stable or has a direct term, and for a length that is not above 0.
    """
    above_zero(exposure_s, "an exposure", "s")
    A, B, C = system.A, system.B, system.C
    if np.any(system.D):
        raise ValueError("the motion has a direct term, so that its variance is infinite: give one with D = 0")
    slowest = float(np.max(np.linalg.eigvals(A).real, initial=-np.inf))
    if slowest >= 0.0:
        raise ValueError(f"the motion has a pole of {slowest:g} rad/s: it is not stationary; give a stable system")
    b = covariance(A, B) @ C.T
    phi, step, white = _phi(A, b, exposure_s), A * exposure_s, exposure_s * (C @ B) @ (C @ B).T

    def both(of: Floats) -> Floats:
        half = C @ of
        return np.asarray(half + half.T)

    whole, displacement = C @ b, both(phi[2])
    smear = 144.0 * both(phi[3] - phi[4] - phi[2] / 4.0)
    if np.trace(smear) < _SMALL * np.trace(displacement):
        smear = 1.2 * white + 144.0 * both(step @ step @ (phi[5] - phi[6] - phi[4] / 4.0))
    jitter = whole - displacement - smear / 12.0
    if np.trace(jitter) < _SMALL * np.trace(whole):
        jitter = white / 15.0 + 0.5 * both(
            np.linalg.matrix_power(step, 3) @ (4.0 * phi[5] - 24.0 * phi[6] + 24.0 * phi[7])
        )
    return Exposure(displacement, smear, jitter)


# ----------------------------------------------------------------------------------------------- tables and recordings
def tabulated_rms(freq_hz: ArrayLike, density_rad2_hz: ArrayLike, index: ErrorIndex, sided: Sides) -> float:
    """What an index takes of a tabulated density (rad rms): a power of frequency between two points, none beyond them.

    Args:
        freq_hz: Frequencies (Hz), rising, the first one above 0, shape (points,).
        density_rad2_hz: Density there (rad^2/Hz), above 0, shape (points,).
        index: What counts of it.
        sided: "one" where the density holds all power above 0 Hz, "two" where it holds half of it.

    Raises:
        ValueError: For another shape or value, and where `sided` is neither.
    """
    if sided not in get_args(Sides):
        raise ValueError(f'sided is "{sided}": say "one" or "two", they differ by a factor of 2 in power')
    freq = rising(np.asarray(freq_hz, dtype=float), "frequencies of the density")
    density = np.asarray(density_rad2_hz, dtype=float)
    if freq[0] <= 0.0 or density.shape != freq.shape or not (np.isfinite(density).all() and (density > 0.0).all()):
        raise ValueError("a density needs one finite value above 0 for each frequency above 0 Hz")
    parts = (_segment(*ends, index) for ends in zip(pairwise(freq), pairwise(density), strict=True))
    return math.sqrt(math.fsum(parts) * (1.0 if sided == "one" else 2.0))


def _segment(freq: tuple[float, float], density: tuple[float, float], index: ErrorIndex) -> float:
    """Integral of density times weight between two points."""
    from scipy.integrate import quad

    power = math.log(density[1] / density[0]) / math.log(freq[1] / freq[0])

    def level(f: float) -> float:
        return float(density[0] * (f / freq[0]) ** power)

    longest = max(index.window_s or 0.0, index.spacing_s or 0.0)
    calm = min(max(_CALM / longest, freq[0]), freq[1]) if longest else freq[1]
    found = [quad(lambda f: level(f) * float(index.weight(f)[0]), freq[0], calm, **_PRECISE)[0]]
    edges = np.geomspace(calm, freq[1], 2 + int(math.log10(freq[1] / calm)))
    for low, high in pairwise(edges[edges.size * (calm == freq[1]) :].tolist()):
        if index.takes == "RPE":
            found.append(quad(level, low, high, **_PRECISE)[0])
        for factor, turns_s in index.cosines:
            over = (factor, -factor)[index.takes == "RPE"]
            part = {"weight": "cos", "wvar": 2.0 * math.pi * turns_s} if turns_s else {}
            found.append(over * quad(lambda f: level(f) / f**2, low, high, **part, **_PRECISE)[0])
    return math.fsum(found)


def recorded_rms(samples_rad: ArrayLike, step_s: float, index: ErrorIndex) -> float:
    """What an index takes of a recorded motion (rad rms), of all windows that it holds.

    A mean over a window is that of its samples. Drift belongs to the motion: nothing is taken off before, but that APE,
    PDE and PRE of a recording are of its own length and no longer one.

    Args:
        samples_rad: The motion (rad), evenly sampled, shape (samples,).
        step_s: Between two samples (s), above 0.
        index: What counts of it; its times are rounded to whole samples.

    Raises:
        ValueError: For samples that are not finite or not of this shape, for a window shorter than two samples, and for
            windows that do not fit into the recording.
    """
    samples = np.asarray(samples_rad, dtype=float)
    above_zero(step_s, "the step of a recording", "s")
    if samples.ndim != 1 or not samples.size or not np.isfinite(samples).all():
        raise ValueError(f"a recorded motion has the shape {samples.shape}: give one row of finite samples, in rad")
    if index.window_s is None:
        return float(np.sqrt(np.mean(samples**2)))
    times = index.window_s, index.spacing_s or 0.0
    window, apart = (round(min(each / step_s, samples.size + 1.0)) for each in times)
    if window < 2 or (index.spacing_s is not None and apart < 1):
        raise ValueError(
            f"{index.kind}: its times are shorter than two samples of {step_s:g} s, or its spacing than one: give "
            "longer ones"
        )
    if window + apart > samples.size:
        raise ValueError(
            f"{index.kind} looks at {sum(times):g} s, and the recording is {samples.size * step_s:g} s "
            "long: give shorter times or a longer recording"
        )
    means = _running(samples, window)
    if index.takes == "MPE":
        return float(np.sqrt(np.mean(means**2)))
    if index.spacing_s is not None:
        return float(np.sqrt(np.mean((means[apart:] - means[: means.size - apart]) ** 2)))
    middle = samples - np.mean(samples)  # the mean of squares less the squared mean loses no digits about it
    left = _running(middle**2, window) - _running(middle, window) ** 2
    return math.sqrt(max(float(np.mean(left)), 0.0))


def _running(values: Floats, window: int) -> Floats:
    """Mean of each window of so many samples."""
    total = np.concatenate([[0.0], np.cumsum(values)])
    sums: Floats = total[window:] - total[:-window]
    return sums / window
