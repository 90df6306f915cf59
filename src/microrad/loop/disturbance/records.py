"""A disturbance of one axis: a shaping filter and spectral lines, and what follows from them.

x' = A x + B w, d = C x, with w white of unit two-sided density, so that the one-sided density of d is
2 |C (2 pi i f - A)^-1 B|^2 in rad^2/Hz, and sinusoids of random phase are added. All angles are of the line of sight
outside the telescope, per axis; a radial spectrum is the sum of two equal axes and is halved here.
"""

import math
from dataclasses import dataclass, replace
from typing import Literal, get_args

import numpy as np

from microrad.core import lti
from microrad.core.arrays import Floats

Convention = Literal["radial", "per-axis"]
"""What given numbers are: of both axes together (power shared equally) or of each axis."""


@dataclass(frozen=True, slots=True)
class SpectralLine:
    """A sinusoid of random phase; raises ValueError unless its amplitude is >= 0 and its frequency > 0."""

    amplitude_rad: float
    freq_hz: float

    def __post_init__(self) -> None:
        """Check both numbers."""
        at_least_zero(self.amplitude_rad, "amplitude of a spectral line", "rad")
        above_zero(self.freq_hz, "frequency of a spectral line", "Hz")


@dataclass(frozen=True, slots=True)
class Disturbance:
    """Motion of one axis as this module's head describes it: A (n, n), B (n, inputs), C (1, n); n may be 0.

    ``basis`` says how the filter came about, ``source`` who gave the numbers. Raises ValueError for arrays that do not
    fit together, that are not finite, and for a filter that is not stable, whose variance would not exist.
    """

    name: str
    A: Floats
    B: Floats
    C: Floats
    lines: tuple[SpectralLine, ...]
    basis: str
    source: str

    def __post_init__(self) -> None:
        """Check shapes and stability."""
        n, where = self.A.shape[0], f'shaping filter of "{self.name}"'
        if self.A.shape != (n, n) or self.B.ndim != 2 or self.B.shape[0] != n or self.C.shape != (1, n):
            raise ValueError(
                f"{where}: A {self.A.shape}, B {self.B.shape} and C {self.C.shape} do not fit together; "
                "give A (n, n), B (n, inputs) and C (1, n)"
            )
        if not all(np.all(np.isfinite(matrix)) for matrix in (self.A, self.B, self.C)):
            raise ValueError(f"{where}: A, B or C holds a number that is not finite; give finite numbers")
        slowest = float(np.max(np.linalg.eigvals(self.A).real, initial=-np.inf))
        if slowest >= 0.0:
            raise ValueError(
                f"{where}: a pole has the real part {slowest:g} rad/s, so its motion has no variance; "
                "every pole must lie left of the imaginary axis"
            )

    @property
    def variance_rad2(self) -> float:
        """Stationary variance: of the filter (Lyapunov equation), and half the squared amplitude of each line."""
        noise = float((self.C @ covariance(self.A, self.B) @ self.C.T).item())
        return noise + math.fsum(0.5 * line.amplitude_rad**2 for line in self.lines)

    @property
    def rms_rad(self) -> float:
        """Root of the stationary variance."""
        return math.sqrt(self.variance_rad2)


def share(convention: Convention) -> float:
    """Part of a given power that one axis has: a half of a radial one, all of one that is given per axis.

    Raises:
        ValueError: For an unknown convention.
    """
    if convention not in get_args(Convention):
        raise ValueError(f'convention "{convention}" of a spectrum is not known; say "radial" or "per-axis"')
    return 0.5 if convention == "radial" else 1.0


def above_zero(value: float, what: str, unit: str) -> None:
    """Raise ValueError unless the number is finite and above zero.

    Args:
        value: The number.
        what: What it is, as the message begins.
        unit: Its unit, for the message.

    Raises:
        ValueError: The number is not.
    """
    if not 0.0 < value < math.inf:
        raise ValueError(f"{what} is {value:g} {unit}; give a finite number above zero")


def at_least_zero(value: float, what: str, unit: str) -> None:
    """Raise ValueError unless the number is finite and not negative.

    Args:
        value: The number.
        what: What it is, as the message begins.
        unit: Its unit, for the message.

    Raises:
        ValueError: The number is not.
    """
    if not 0.0 <= value < math.inf:
        raise ValueError(f"{what} is {value:g} {unit}; give a finite number, zero or above")


def rising(values: Floats, what: str) -> Floats:
    """The values as an array, once they are seen to rise strictly from zero or above.

    Args:
        values: Frequencies (Hz), two or more.
        what: What they are, as the message begins.

    Raises:
        ValueError: They do not rise, or are fewer than two.
    """
    array = np.asarray(values, dtype=float)
    if array.ndim != 1 or array.size < 2 or not array[0] >= 0.0 or not np.all(np.diff(array) > 0.0):
        raise ValueError(f"{what} are {array.tolist()} Hz; give two or more that rise from 0 Hz or above")
    return array


def covariance(A: Floats, B: Floats) -> Floats:
    """Stationary covariance P of x' = A x + B w, shape (n, n): A P + P A' + B B' = 0.

    Args:
        A: Map of the states of a stable filter (1/s), shape (n, n); n may be 0.
        B: What white noise of unit two-sided density adds to them, shape (n, inputs).
    """
    from scipy.linalg import solve_continuous_lyapunov

    return np.zeros((0, 0)) if A.size == 0 else np.asarray(solve_continuous_lyapunov(A, -B @ B.T))


def psd(disturbance: Disturbance, freq_hz: Floats) -> Floats:
    """One-sided density (rad^2/Hz) of the continuous part, shape (frequencies,); lines are not in it.

    Args:
        disturbance: The disturbance of one axis.
        freq_hz: Frequencies, shape (frequencies,).
    """
    feedthrough = np.zeros((1, disturbance.B.shape[1]))
    system = lti.StateSpace(disturbance.A, disturbance.B, disturbance.C, feedthrough)
    response = lti.frequency_response(system, np.asarray(freq_hz, dtype=float))[:, 0, :]
    return np.asarray(2.0 * np.sum(np.abs(response) ** 2, axis=1))


def band_rms(disturbance: Disturbance, edges_hz: Floats) -> Floats:
    """Rms (rad) in each band between neighbouring edges, shape (edges - 1,), lines included.

    Exact: the density is 4 Re[C (i w - A)^-1 P C'], P the stationary covariance, and its integral is a logarithm by
    mode. A line on an edge counts in the band above it.

    Args:
        disturbance: The disturbance of one axis.
        edges_hz: Edges of the bands, rising, shape (edges,); the last one may be infinite.

    Raises:
        ValueError: For edges that do not rise from 0 Hz or above, and for a filter without a modal form.
    """
    edges = rising(edges_hz, "edges of the bands")
    poles, modes = np.linalg.eig(disturbance.A)
    if disturbance.A.size and np.linalg.cond(modes) > 1e10:
        raise ValueError(f'"{disturbance.name}": poles coincide, so its bands have no closed form; move one by 0.1 %')
    spread = covariance(disturbance.A, disturbance.B) @ disturbance.C.T
    weights = (disturbance.C @ modes)[0] * np.linalg.solve(modes, spread)[:, 0]
    finite = np.where(np.isinf(edges), 0.0, edges)
    up_to = (2.0 / np.pi) * (np.log(2j * np.pi * finite[:, None] - poles) @ weights).imag
    variance = np.diff(np.where(np.isinf(edges), np.sum(weights).real, up_to))
    for line in disturbance.lines:
        variance += 0.5 * line.amplitude_rad**2 * ((edges[:-1] <= line.freq_hz) & (line.freq_hz < edges[1:]))
    return np.asarray(np.sqrt(np.maximum(variance, 0.0)))


def combine(*disturbances: Disturbance) -> Disturbance:
    """Several independent disturbances of one axis as one, block-diagonal.

    States that come in pairs stand before single ones, so that every pair begins at an even row.

    Raises:
        ValueError: For none.
    """
    from scipy.linalg import block_diag

    if not disturbances:
        raise ValueError("no disturbance to combine; give one or more")
    A, B = (block_diag(*matrices) for matrices in zip(*((d.A, d.B) for d in disturbances), strict=True))
    C = np.hstack([d.C for d in disturbances])
    return Disturbance(
        " + ".join(d.name for d in disturbances),
        *_pairs_first(A, B, C),
        tuple(line for d in disturbances for line in d.lines),
        "; ".join(d.basis for d in disturbances),
        "; ".join(dict.fromkeys(d.source for d in disturbances)),
    )


def _pairs_first(A: Floats, B: Floats, C: Floats) -> tuple[Floats, Floats, Floats]:
    """The same filter with the states that touch no other behind those that do."""
    coupled = (A != 0.0) & ~np.eye(A.shape[0], dtype=bool)
    order = np.argsort(~(coupled.any(axis=0) | coupled.any(axis=1)), kind="stable")
    return A[np.ix_(order, order)], B[order], C[:, order]


def one_input(disturbance: Disturbance) -> Disturbance:
    """The same spectrum from a single white input (spectral factorisation), for one random number a step.

    The poles stay; the zeros are those of the density that lie in the left half-plane. Returned as it is where it has
    no more than one input, and where the factor misses the density by more than 1e-6 (zeros or poles that coincide).
    """
    A, B, C = disturbance.A, disturbance.B, disturbance.C
    n = A.shape[0]
    if B.shape[1] <= 1:
        return disturbance
    density = lti.StateSpace(
        np.block([[A, B @ B.T], [np.zeros((n, n)), -A.T]]),
        np.vstack([np.zeros((n, 1)), C.T]),
        np.hstack([C, np.zeros((1, n))]),
        np.zeros((1, 1)),
    )
    poles = np.linalg.eigvals(A).astype(complex)
    probe = np.sort(np.append(np.abs(poles), np.geomspace(0.03, 30.0, 200) * np.median(np.abs(poles)))) / (2.0 * np.pi)
    wanted = psd(disturbance, probe)
    at = int(np.argmax(wanted))
    zeros = lti.zeros(density)
    try:
        factor = lti.modal_from_roots(zeros[zeros.real < 0.0], poles, float(probe[at]))
    except ValueError:
        return disturbance
    A, B, C = _pairs_first(factor.A, factor.B, factor.C * math.sqrt(0.5 * wanted[at]))
    found = replace(disturbance, A=A, B=B, C=C)
    return found if np.allclose(psd(found, probe), wanted, rtol=1e-6, atol=0.0) else disturbance
