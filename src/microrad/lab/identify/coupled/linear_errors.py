"""How well the numbers of a linear model behind a delay are known from the records it was fitted to.

The derivatives of the response by every number of the plant form, and by the delay, give the normal equations of the
output error over all lines, and the pull of each record on each number. Where records repeat, each counts as one
independent draw of drive, noise and distortion (cluster-robust sandwich); else what is left of the response counts as
white noise.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from microrad.core.arrays import Complexes, Floats
from microrad.lab.identify.linear.modal import ModalModel, hold_basis
from microrad.lab.identify.linear.response import FrequencyResponse
from microrad.lab.recording import Recording
from microrad.mirror.coupled import Known

_LINES = 512  # of a response worked on at a time
_RANK = 1e-9


class LineSpectra(NamedTuple):
    """Drive (records, lines, inputs) and output (records, lines, outputs) at the lines of a response, one-sided."""

    drive: Complexes
    output: Complexes


@dataclass(frozen=True, eq=False)
class Spread:
    """How the numbers of a model would move with other records.

    ``moved`` (rows, numbers) is a root of their covariance, moved.T @ moved; ``step`` (numbers,) how far the records
    would still move each. Numbers are in the order of `names`, the delay last.
    """

    moved: Floats
    step: Floats


def line_spectra(records: Sequence[Recording], response: FrequencyResponse) -> LineSpectra | None:
    """Spectra of the mean period of each record at the lines of their response.

    None where the records do not repeat, or are no more than the drives: then none is left to tell how they scatter.

    Args:
        records: The records.
        response: Their response.
    """
    if any(r.period_samples is None for r in records) or len(records) <= records[0].drive.shape[1]:
        return None
    period = records[0].period_samples or 1
    lines = np.rint(response.freq_hz * period / records[0].rate_hz).astype(int)

    def spectra(values: Sequence[Floats]) -> Complexes:
        mean = np.stack([v[: len(v) // period * period].reshape(-1, period, v.shape[1]).mean(axis=0) for v in values])
        return np.asarray(np.fft.rfft(mean, axis=1)[:, lines] * (np.sqrt(2.0) / period))

    return LineSpectra(spectra([r.drive for r in records]), spectra([r.output for r in records]))


def spread(
    model: ModalModel,
    response: FrequencyResponse,
    delay_s: float,
    spectra: LineSpectra | None,
    *,
    fixed_delay: bool = False,
) -> Spread:
    """How well the numbers of a fitted model are known.

    Args:
        model: The model, fitted to the response.
        response: The response of what is behind the delay, see `linear.without_delay`.
        delay_s: The delay, in s.
        spectra: Spectra of the records, as recorded; None for the covariance of white noise.
        fixed_delay: Whether the delay was not fitted.
    """
    outputs, inputs = model.direct.shape
    count = len(names(model, range(inputs), range(outputs)))
    normal, gradient = np.zeros((count, count)), np.zeros(count)
    pulls = np.zeros((1 if spectra is None else len(spectra.drive), count))
    cost, values = 0.0, 0
    for lines in _parts(response.freq_hz.size):
        J = jacobian(model, response, lines)
        J[..., -1] *= not fixed_delay
        factor = np.linalg.cholesky(response.drive_power[lines] + _floor(response.drive_power[lines]))
        weighed = _real(np.einsum("foip,fik->fokp", J, factor, optimize=True))
        normal += weighed.T @ weighed
        left = response.response[lines] - model.response(response.freq_hz[lines], response.hold, response.rate_hz)
        error = _real((left @ factor)[..., None])[:, 0]
        gradient += weighed.T @ error
        cost, values = cost + float(error @ error), values + error.size
        if spectra is not None:
            pulls += _pulls(J, model, response, (spectra, delay_s, lines))
    inverse, rank = _inverse(normal)
    if spectra is None:
        root = np.sqrt(cost / max(values - rank, 1))
        vectors, size, _ = np.linalg.svd(inverse, hermitian=True)
        moved = root * np.sqrt(size[:rank, None]) * vectors[:, :rank].T
    else:
        records = len(pulls)
        pulls = (pulls - pulls.mean(axis=0)) / records  # the normal matrix is that of the mean record
        moved = pulls @ inverse * np.sqrt(records / max(records - 1, 1))
    return Spread(moved, inverse @ gradient)


def names(
    model: ModalModel, drives: Sequence[int], outputs: Sequence[int], states: int = 0, modes: int = 0
) -> tuple[str, ...]:
    """Names of the numbers of a model as in a mirror file (see `Known`), the delay last.

    Args:
        model: The modal model; real poles first.
        drives: Number of each of its inputs in the mirror, from 0.
        outputs: Number of each of its outputs in the mirror, from 0.
        states: States of the mirror that stand before its own.
        modes: Modes of the mirror that stand before its own.
    """
    count, real = model.poles_rad_s.size, model.real_poles
    own = range(states + 1, states + model.order + 1)
    return (
        *(f"modes.decay.{modes + k + 1}" for k in range(count)),
        *(f"modes.frequency.{modes + k + 1}" for k in range(real, count)),
        *(f"matrices.B.{row}.{i + 1}" for row in own for i in drives),
        *(f"matrices.C.{o + 1}.{row}" for o in outputs for row in own),
        *(f"matrices.D.{o + 1}.{i + 1}" for o in outputs for i in drives),
        "recording.delay",
    )


def known(parameters: Sequence[str], moved: Floats) -> Known:
    """Standard errors and correlation of parameters from a root of their covariance; those without an error left out.

    Args:
        parameters: Their names.
        moved: Root of the covariance, shape (rows, parameters).
    """
    errors = np.sqrt(np.sum(moved**2, axis=0))
    kept = np.flatnonzero(errors > 0.0)
    factor = (moved[:, kept] / errors[kept]).T
    return Known(tuple(parameters[int(k)] for k in kept), errors[kept], np.ascontiguousarray(factor))


def _parts(lines: int) -> Iterator[slice]:
    return (slice(begin, begin + _LINES) for begin in range(0, lines, _LINES))


def _floor(power: Complexes) -> Floats:
    return np.asarray(1e-12 * np.trace(power, axis1=1, axis2=2).real[:, None, None] * np.eye(power.shape[1]))


def _real(values: Complexes) -> Floats:
    """All but the last axis as rows, real parts before imaginary ones."""
    flat = values.reshape(-1, values.shape[-1])
    return np.concatenate([flat.real, flat.imag])


def _inverse(normal: Floats) -> tuple[Floats, int]:
    """Inverse over what the data fix (the scale of each state is not), and its rank."""
    size = np.sqrt(np.where(np.diag(normal) > 0.0, np.diag(normal), 1.0))
    values, vectors = np.linalg.eigh(normal / np.outer(size, size))
    fixed = values > _RANK * values[-1]
    inverse = (vectors[:, fixed] / values[fixed]) @ vectors[:, fixed].T / np.outer(size, size)
    return np.asarray(inverse), int(np.count_nonzero(fixed))


def _pulls(
    J: Complexes, model: ModalModel, response: FrequencyResponse, of: tuple[LineSpectra, float, slice]
) -> Floats:
    """What each record adds to the gradient, shape (records, numbers)."""
    spectra, delay_s, lines = of
    freq = response.freq_hz[lines]
    drive = spectra.drive[:, lines]
    ahead = np.exp(2j * np.pi * freq * delay_s)[None, :, None]
    modelled = np.einsum("foi,mfi->mfo", model.response(freq, response.hold, response.rate_hz), drive)
    left = spectra.output[:, lines] * ahead - modelled
    weights = (left[:, :, :, None] * drive.conj()[:, :, None, :]).reshape(len(drive), -1)
    flat = J.reshape(-1, J.shape[-1])
    return np.asarray(weights.real @ flat.real + weights.imag @ flat.imag)


def jacobian(model: ModalModel, response: FrequencyResponse, lines: slice) -> Complexes:
    """Derivative of the response behind the delay by each number: (lines, outputs, inputs, numbers).

    G = sum of c b phi(p) over all poles, with b = B_0 + j B_1 and c = (C_0 - j C_1) / 2 for a pair; phi is the response
    of 1/(s - p) behind the hold.
    """
    freq, m = response.freq_hz[lines], model.real_poles
    poles, (b, c) = model.all_poles_rad_s, model.all_vectors
    phi, slope = hold_basis(poles, freq, response.hold, response.rate_hz)
    assert slope is not None
    n, (outputs, inputs) = model.poles_rad_s.size, model.direct.shape
    upper, lower = np.arange(m, n), np.arange(n, poles.size)
    residues = np.einsum("ok,ki->koi", c, b)
    each = np.einsum("fk,koi->fkoi", slope, residues)
    found = [each[:, :m], each[:, upper] + each[:, lower]]  # by the real part of the poles
    decay = np.concatenate(found, axis=1)
    frequency = 1j * (each[:, upper] - each[:, lower])
    # rows of B and columns of C: what multiplies them
    through_b = np.einsum("fk,ok->fko", phi, c)
    through_c = np.einsum("fk,ki->fki", phi, b)
    by_b, by_c = _by_states(through_b, (m, n)), _by_states(through_c, (m, n))
    by_c[:, m:] *= np.array([0.5, -0.5])[np.arange(by_c.shape[1] - m) % 2][None, :, None]
    eye_in, eye_out = np.eye(inputs), np.eye(outputs)
    lines_count = freq.size
    parts = [
        -decay.transpose(0, 2, 3, 1),
        frequency.transpose(0, 2, 3, 1),
        np.einsum("fso,ij->foisj", by_b, eye_in).reshape(lines_count, outputs, inputs, -1),
        np.einsum("fsi,oq->foiqs", by_c, eye_out).reshape(lines_count, outputs, inputs, -1),
        np.broadcast_to(
            np.einsum("oq,ij->oiqj", eye_out, eye_in).reshape(outputs, inputs, -1),
            (lines_count, outputs, inputs, outputs * inputs),
        ),
        (-2j * np.pi * freq[:, None, None] * model.combined(phi))[..., None],
    ]
    return np.concatenate(parts, axis=3)


def _by_states(through: Complexes, counts: tuple[int, int]) -> Complexes:
    """Of poles (lines, all poles, channels) the states: real ones, then sum and turned difference of each pair."""
    m, n = counts
    upper, lower = through[:, m:n], through[:, n:]
    pairs = np.stack([upper + lower, 1j * (upper - lower)], axis=2)
    return np.concatenate([through[:, :m], pairs.reshape(len(through), -1, through.shape[2])], axis=1)
