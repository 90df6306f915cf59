"""Linear models as a sum of rank-one modes, and what a hold in front of them makes of their sampled response.

    G(s) = D + sum over real poles of c b / (s - p) + sum over pairs of (c b / (s - p) + its conjugate)

with c a column (outputs) and b a row (inputs): a real pole costs one state, a pair two. A mode with a residue of higher
rank is several modes with poles nearby. The drive between two samples is what `Hold` says:

    zero-order    constant, as a converter holds it         x[k+1] = e^a x[k] + T phi1(a) u[k]
    first-order   straight, as a simulation interpolates    x[k+1] = e^a x[k] + T (phi1 - phi2) u[k] + T phi2 u[k+1]
    band-limited  without content above half the rate       the sampled response is the continuous one

a = p T, phi1 = (e^a - 1)/a, phi2 = (phi1 - 1)/a. The first two are exact at the samples.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Literal, NamedTuple

import numpy as np

from microrad.core.arrays import Complexes, Floats
from microrad.core.lti import StateSpace, modal_matrix
from microrad.lab.identify.records import IdentificationError

Hold = Literal["zero-order", "first-order", "band-limited"]

HOLD: Hold = "zero-order"
"""What a recorded drive does between samples, unless it is said: what is recorded is what a converter was told."""


class Step(NamedTuple):
    """Of modes x' = p x + u over one sample: x[k+1] = keep x[k] + begin u[k] + end u[k+1], and derivatives by p."""

    keep: Complexes
    begin: Complexes
    end: Complexes
    keep_rate: Complexes
    begin_rate: Complexes
    end_rate: Complexes


@dataclass(frozen=True, eq=False)
class ModalModel:
    """Rank-one modes of a stable continuous system; real poles first, of each pair the pole with positive frequency.

    `poles_rad_s` has the shape (modes,), `input_vectors` (modes, inputs), `output_vectors` (outputs, modes) and
    `direct` (outputs, inputs). The vectors of real poles are real. `delay_s` is a pure delay of the recording chain:
    responses and simulations have it, the state space has not.
    """

    poles_rad_s: Complexes
    input_vectors: Complexes
    output_vectors: Complexes
    direct: Floats
    delay_s: float = 0.0

    @cached_property
    def real_poles(self) -> int:
        """Number of modes with a real pole; they stand first."""
        return int(np.count_nonzero(self.poles_rad_s.imag == 0))

    @property
    def order(self) -> int:
        """Number of states."""
        return 2 * self.poles_rad_s.size - self.real_poles

    @cached_property
    def all_poles_rad_s(self) -> Complexes:
        """Every pole, conjugates included."""
        return np.concatenate([self.poles_rad_s, self.poles_rad_s[self.real_poles :].conj()])

    def response(self, freq_hz: Floats, hold: Hold = "band-limited", rate_hz: float | None = None) -> Complexes:
        """Sampled response behind the hold, shape (frequencies, outputs, inputs); band-limited is the continuous one.

        Args:
            freq_hz: Frequencies, in Hz, shape (frequencies,).
            hold: What the drive does between samples.
            rate_hz: Sample rate, in Hz; a band-limited drive needs none.

        Raises:
            IdentificationError: For a hold without a rate.
        """
        undelayed = self.combined(hold_basis(self.all_poles_rad_s, freq_hz, hold, rate_hz)[0])
        if self.delay_s == 0.0:
            return undelayed
        return np.asarray(undelayed * np.exp(-2j * np.pi * np.asarray(freq_hz) * self.delay_s)[:, None, None])

    def combined(self, basis: Complexes) -> Complexes:
        """The direct term and the sum of all modes, each times its column of a basis (points, all poles)."""
        inputs, outputs = self.all_vectors
        return np.asarray((outputs * basis[:, None, :]) @ inputs + self.direct)

    @cached_property
    def all_vectors(self) -> tuple[Complexes, Complexes]:
        """Input vectors (all poles, inputs) and output vectors (outputs, all poles), conjugates included."""
        b, c = self.input_vectors, self.output_vectors
        return np.vstack([b, b[self.real_poles :].conj()]), np.hstack([c, c[:, self.real_poles :].conj()])

    def state_space(self) -> StateSpace:
        """Real modal (block-diagonal) continuous state space."""
        n, count = self.order, self.real_poles
        B, C = np.zeros((n, self.direct.shape[1])), np.zeros((self.direct.shape[0], n))
        row = 0
        for k, (b, c) in enumerate(zip(self.input_vectors, self.output_vectors.T, strict=True)):
            if k < count:
                B[row], C[:, row] = b.real, c.real
                row += 1
                continue
            B[row : row + 2] = b.real, b.imag
            C[:, row], C[:, row + 1] = 2 * c.real, -2 * c.imag
            row += 2
        A = modal_matrix([(pole.real, pole.imag) for pole in self.poles_rad_s.tolist()])
        return StateSpace(A, B, C, self.direct.copy())


def order_modes(poles: Complexes, inputs: Complexes, outputs: Complexes, direct: Floats) -> ModalModel:
    """A model of the given modes, real ones first, then by frequency, with vectors of equal length in each mode.

    Args:
        poles: One pole of each mode, in rad/s, shape (modes,), of a pair the one with positive frequency.
        inputs: Input vectors, shape (modes, inputs).
        outputs: Output vectors, shape (outputs, modes).
        direct: Direct term, shape (outputs, inputs).
    """
    size_in = np.linalg.norm(inputs, axis=1)
    balance = np.sqrt(np.linalg.norm(outputs, axis=0) / np.where(size_in > 0, size_in, 1.0))
    balance = np.where(balance > 0, balance, 1.0)
    rank = np.lexsort((np.abs(poles), poles.imag != 0))
    scaled_in, scaled_out = inputs * balance[:, None], outputs / balance
    return ModalModel(poles[rank], scaled_in[rank], scaled_out[:, rank], np.asarray(direct, dtype=float))


def rank_one_modes(
    poles: Complexes, residues: Iterable[Complexes], direct: Floats, most: int | None = None
) -> ModalModel:
    """Modes with the singular vectors of each residue, as many as its rank.

    Args:
        poles: Poles, in rad/s, without their conjugates.
        residues: One matrix (outputs, inputs) for each pole.
        direct: Direct term, shape (outputs, inputs).
        most: Largest number of modes for one pole, None for no limit.
    """
    kept, inputs, outputs = [], [], []
    for pole, residue in zip(poles, residues, strict=True):
        left, size, right = np.linalg.svd(residue if pole.imag > 0 else residue.real)
        for k in np.flatnonzero(size > 1e-12 * max(size[0], 1e-300))[:most]:
            kept.append(pole)
            inputs.append(right[k] * np.sqrt(size[k]))
            outputs.append(left[:, k] * np.sqrt(size[k]))
    b, c = (np.array(v, dtype=complex).reshape(-1, n) for v, n in ((inputs, direct.shape[1]), (outputs, len(direct))))
    return order_modes(np.array(kept, dtype=complex), b, c.T, direct)


def real_columns(basis: Complexes, real: int) -> Complexes:
    """Columns with real coefficients: those of the real poles, then sums and turned differences of each pair.

    Args:
        basis: Columns of the real poles, then of the upper halves of the pairs, then of the lower ones, shape (rows,
            poles).
        real: Number of real poles.
    """
    pairs = (basis.shape[1] - real) // 2
    upper, lower = basis[:, real : real + pairs], basis[:, real + pairs :]
    return np.concatenate([basis[:, :real], upper + lower, 1j * (upper - lower)], axis=1)


# ---------------------------------------------------------------------------------------------------------- the hold
def hold_step(poles_rad_s: Complexes, hold: Hold, rate_hz: float) -> Step:
    """One exact step of each mode, from sample to sample, for a drive held in a given way.

    Args:
        poles_rad_s: Poles, in rad/s, shape (modes,).
        hold: What the drive does between samples.
        rate_hz: Sample rate, in Hz.

    Raises:
        IdentificationError: For a band-limited drive, which has no such step.
    """
    if hold == "band-limited":
        raise IdentificationError(
            "a band-limited drive cannot be stepped from sample to sample; choose the zero-order hold (a converter "
            "holds each value) or the first-order hold (straight lines between the samples)."
        )
    period = 1.0 / rate_hz
    a = np.asarray(np.asarray(poles_rad_s) * period, dtype=np.complex128)
    keep, one, one_rate, two, two_rate = _phi(a)
    if hold == "zero-order":
        two, two_rate = np.zeros_like(a), np.zeros_like(a)
    return Step(
        keep,
        period * (one - two),
        period * two,
        period * keep,
        period**2 * (one_rate - two_rate),
        period**2 * two_rate,
    )


def _phi(a: Complexes) -> tuple[Complexes, Complexes, Complexes, Complexes, Complexes]:
    """e^a, phi1, d phi1 / da, phi2, d phi2 / da; by their series near zero, where the formulas cancel."""
    small = np.abs(a) < 0.5
    safe = np.where(small, 1.0, a)
    keep = np.exp(a)
    one = np.expm1(safe) / safe
    one_rate = (np.exp(safe) - one) / safe
    two = (one - 1.0) / safe
    two_rate = (one_rate - two) / safe
    k = np.arange(14)
    first = np.array([1.0 / math.factorial(j + 1) for j in k])
    second = np.array([1.0 / math.factorial(j + 2) for j in k])
    near = np.where(small, a, 0.0)[..., None]
    power = near**k
    slope = k[1:] * near ** (k[1:] - 1)
    return (
        keep,
        np.where(small, power @ first, one),
        np.where(small, slope @ first[1:], one_rate),
        np.where(small, power @ second, two),
        np.where(small, slope @ second[1:], two_rate),
    )


def hold_basis(
    poles_rad_s: Complexes, freq_hz: Floats, hold: Hold, rate_hz: float | None, *, rates: bool = True
) -> tuple[Complexes, Complexes | None]:
    """Sampled response of 1/(s - p) behind the hold, and its derivative by p, both of shape (frequencies, poles).

    Args:
        poles_rad_s: Poles p, in rad/s, shape (poles,).
        freq_hz: Frequencies, in Hz, shape (frequencies,).
        hold: What the drive does between samples.
        rate_hz: Sample rate, in Hz; None is enough for a band-limited drive.
        rates: Whether the derivative is wanted; else it is None.

    Raises:
        IdentificationError: For another hold without a rate.
    """
    s = 2j * np.pi * np.asarray(freq_hz, dtype=float)[:, None]
    p = np.asarray(poles_rad_s, dtype=complex)[None, :]
    if hold == "band-limited":
        basis = 1.0 / (s - p)
        return basis, basis * basis if rates else None
    if rate_hz is None:
        raise IdentificationError(f"a {hold} hold needs the sample rate; give rate_hz.")
    step = hold_step(p[0], hold, rate_hz)
    # z - e^a as a difference of expm1, which keeps slow poles apart from 1.
    gap = 1.0 / (np.expm1(s / rate_hz) - np.expm1(p / rate_hz))
    if hold == "zero-order":  # nothing of the sample ahead
        basis = step.begin * gap
        return basis, step.begin_rate * gap + basis * gap * step.keep_rate if rates else None
    ahead = np.exp(s / rate_hz)
    basis = (step.begin + step.end * ahead) * gap
    return basis, (step.begin_rate + step.end_rate * ahead) * gap + basis * gap * step.keep_rate if rates else None


def filtered(
    poles_rad_s: Complexes, drive: Floats, hold: Hold, rate_hz: float, *, rates: bool = False
) -> tuple[Complexes, Complexes | None]:
    """Each drive behind each mode from rest, and its derivative by the pole, both of shape (modes, inputs, samples).

    Args:
        poles_rad_s: Poles, in rad/s, shape (modes,).
        drive: Drives, shape (samples, inputs).
        hold: What the drive does between samples, not band-limited.
        rate_hz: Sample rate, in Hz.
        rates: Whether the derivatives are wanted; else they are None.

    Raises:
        IdentificationError: For a band-limited drive.
    """
    from scipy.signal import lfilter

    step = hold_step(poles_rad_s, hold, rate_hz)
    u = np.ascontiguousarray(drive.T)
    ahead = np.concatenate([u[:, 1:], u[:, -1:]], axis=1)
    states = np.empty((len(poles_rad_s), *u.shape), dtype=complex)
    slopes = np.empty_like(states) if rates else None
    for k, pole in enumerate(poles_rad_s):
        real = pole.imag == 0
        keep, begin, end, keep_rate, begin_rate, end_rate = (v[k].real if real else v[k] for v in step)
        forcing = begin * u + end * ahead
        states[k] = lfilter([0.0, 1.0], [1.0, -keep], forcing, axis=1)
        if slopes is not None:
            own = states[k].real if real else states[k]
            slopes[k] = lfilter([0.0, 1.0], [1.0, -keep], keep_rate * own + begin_rate * u + end_rate * ahead, axis=1)
    return states, slopes


# --------------------------------------------------------------------------------------------------------- simulation
def simulate(model: ModalModel, drive: Floats, rate_hz: float, hold: Hold = "zero-order") -> Floats:
    """Output (samples, outputs) from rest, exact at the samples for the hold.

    Args:
        model: The modal model.
        drive: Drives, shape (samples, inputs).
        rate_hz: Sample rate, in Hz.
        hold: What the drive does between samples, not band-limited.

    Raises:
        IdentificationError: For a band-limited drive.
    """
    samples = len(drive)
    drive = beyond(drive, model.delay_s)
    states, _ = filtered(model.poles_rad_s, drive, hold, rate_hz)
    modes = np.einsum("ki,kit->kt", model.input_vectors, states)
    modes[model.real_poles :] *= 2.0
    output = (model.output_vectors @ modes).real.T + drive @ model.direct.T
    return late(output, model.delay_s * rate_hz)[:samples]


_TAPS = 20
_AT = np.arange(_TAPS) - _TAPS // 2 + 1  # samples later than the whole ones that take part


def beyond(drive: Floats, delay_s: float) -> Floats:
    """A drive that stays at its end for as long as `late` looks ahead, where there is a delay.

    Args:
        drive: The drive, shape (samples, inputs).
        delay_s: The delay, in s; at 0 nothing is looked at.
    """
    return drive if delay_s == 0.0 else np.concatenate([drive, np.repeat(drive[-1:], _TAPS, axis=0)])


def late(signal: Floats, samples: float) -> Floats:
    """A signal some samples later, between samples by the polynomial through the twenty nearest.

    That is the Lagrange filter of T. Laakso et al., Splitting the unit delay, IEEE Signal Processing Magazine 13 (1996)
    30: at a fifth of the sample rate it errs by 2e-5, at a quarter by 2e-4. Before its first and behind its last sample
    the signal rests.

    Args:
        signal: The signal, shape (samples, channels).
        samples: The delay in samples; below 0 the signal comes earlier.
    """
    if samples == 0.0:
        return np.asarray(signal)
    whole = math.floor(samples)
    taps, last = _taps(samples - whole), len(signal) - 1
    padded = signal[np.clip(np.arange(-int(_AT[-1]), last + 1 - int(_AT[0])) - whole, 0, last)]
    return np.stack([np.convolve(column, taps, mode="valid") for column in padded.T], axis=1)


@lru_cache(maxsize=64)
def _taps(part: float) -> Floats:
    """Weights of the samples of `_AT` for a delay of part of a sample."""
    others = [_AT[k != _AT] for k in _AT]
    return np.array([np.prod((part - o) / (k - o)) for k, o in zip(_AT, others, strict=True)])


def simulate_periodic(model: ModalModel, period: Floats, rate_hz: float, hold: Hold = "zero-order") -> Floats:
    """Steady-state output (samples, outputs) for a periodic drive.

    Args:
        model: The modal model.
        period: One period of the drives, shape (samples, inputs).
        rate_hz: Sample rate, in Hz.
        hold: What the drive does between samples.
    """
    samples = period.shape[0]
    response = model.response(np.arange(samples // 2 + 1) * (rate_hz / samples), hold, rate_hz)
    if samples % 2 == 0:
        response[-1] = response[-1].real
    spectrum = np.fft.rfft(period, axis=0)
    return np.asarray(np.fft.irfft(np.einsum("foi,fi->fo", response, spectrum), samples, axis=0))
