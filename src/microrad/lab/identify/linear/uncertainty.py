"""Poles, transmission zeros and gains of a fitted modal model, with their standard errors from its normal equations."""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from microrad.core.arrays import Complexes, Floats
from microrad.lab.identify.linear.modal import ModalModel
from microrad.lab.identify.linear.polish import Polished


@dataclass(frozen=True, eq=False)
class Uncertainty:
    """Poles, zeros and gains with standard errors of the complex value.

    `poles_rad_s` and `zeros_rad_s` (transmission zeros below half the sample rate, square systems only) are arrays
    (poles,) and (zeros,); `dc_gain` and `edge_gain` (outputs, inputs) are the gains at zero frequency and at the lowest
    excited one. `delay_error_s` is the standard error of the delay of the recording chain, 0 where it was not fitted.
    """

    poles_rad_s: Complexes
    poles_error_rad_s: Floats
    zeros_rad_s: Complexes
    zeros_error_rad_s: Floats
    dc_gain: Floats
    dc_gain_error: Floats
    edge_gain: Floats
    edge_gain_error: Floats
    delay_error_s: float


def uncertainty(
    model: ModalModel, covariance: Floats, direct: bool, *, edge_hz: float, below_rad_s: float
) -> Uncertainty:
    """Poles, zeros and gains of a model, with their standard errors.

    Args:
        model: The modal model.
        covariance: Covariance of the parameters of `pack`.
        direct: Whether the direct term was fitted.
        edge_hz: Lowest frequency that was measured, in Hz.
        below_rad_s: Largest modulus of the zeros, in rad/s.
    """
    m, n = model.real_poles, model.poles_rad_s.size
    variance = np.diag(covariance)[: 2 * n - m]
    spread = variance[:n].copy()
    spread[m:] += variance[n:]
    spread = np.sqrt(np.maximum(np.concatenate([spread, spread[m:]]), 0.0))
    zeros = transmission_zeros(model, below_rad_s)
    points = np.concatenate([[0.0, 2j * np.pi * edge_hz], zeros])
    slopes = _slopes(model, points, direct)
    values = transfer_matrix(model, points[:2])
    # A gain is real in phase: only the change along the value moves its magnitude.
    direction = values[1].conj() / np.maximum(np.abs(values[1]), 1e-300)
    along = np.stack([slopes[0].real, np.real(direction[:, :, None] * slopes[1])])
    errors = np.sqrt(np.maximum(_variance(along, covariance), 0.0))
    return Uncertainty(
        model.all_poles_rad_s,
        spread,
        zeros,
        _zero_errors(model, zeros, slopes[2:], covariance),
        values[0].real,
        errors[0],
        np.abs(values[1]),
        errors[1],
        0.0,
    )


class Natural(NamedTuple):
    """A pole by its natural frequency (Hz) and damping ratio, each with its standard error."""

    freq_hz: float
    freq_error_hz: float
    damping: float
    damping_error: float


def natural(pole_rad_s: complex, error_rad_s: complex) -> Natural:
    """A pole as natural frequency and damping, the errors of its two parts taken as independent.

    Args:
        pole_rad_s: The pole.
        error_rad_s: Standard errors of its real and of its imaginary part.
    """
    size = abs(pole_rad_s) or 1e-300
    s, w, ds, dw = pole_rad_s.real, pole_rad_s.imag, error_rad_s.real, error_rad_s.imag
    if w == 0.0:
        return Natural(size / (2 * math.pi), abs(ds) / (2 * math.pi), -s / size, 0.0)
    freq_error = math.hypot(s * ds, w * dw) / size / (2 * math.pi)
    return Natural(size / (2 * math.pi), freq_error, -s / size, abs(w) * math.hypot(w * ds, s * dw) / size**3)


def parameter_covariance(polished: Polished) -> Floats:
    """Covariance of the parameters of `pack`, the variance of a row being what is left per degree of freedom."""
    size = np.sqrt(np.maximum(np.diag(polished.normal), 1e-300))
    values = np.linalg.eigvalsh(polished.normal / np.outer(size, size))
    null = int(np.count_nonzero(values <= 1e-11 * values[-1]))
    freedom = max(polished.rows - values.size + null, 1)
    return np.asarray(inverse_normal(polished.normal, null) * polished.cost / freedom)


def inverse_normal(normal: Floats, null: int) -> Floats:
    """Inverse of a normal matrix without the directions that change nothing.

    Args:
        normal: The matrix, shape (parameters, parameters).
        null: Number of such directions: in a modal model the scales of the vectors, one for each state.
    """
    size = np.sqrt(np.maximum(np.diag(normal), 1e-300))
    values, vectors = np.linalg.eigh(normal / np.outer(size, size))
    kept = slice(null, None)
    return np.asarray((vectors[:, kept] / values[kept]) @ vectors[:, kept].T / np.outer(size, size))


def transfer_matrix(model: ModalModel, points: Complexes) -> Complexes:
    """Transfer matrix at any complex frequencies (rad/s), shape (points, outputs, inputs).

    Args:
        model: The modal model.
        points: Complex frequencies, in rad/s, shape (points,).
    """
    return model.combined(1.0 / (np.asarray(points)[:, None] - model.all_poles_rad_s))


def transmission_zeros(model: ModalModel, below_rad_s: float) -> Complexes:
    """Complex frequencies (rad/s) at which the square transfer matrix loses rank; none where it is not square.

    Args:
        model: The modal model.
        below_rad_s: Largest modulus of the zeros returned, in rad/s.
    """
    from scipy.linalg.lapack import dggev

    outputs, inputs = model.direct.shape
    if outputs != inputs:
        return np.zeros(0, dtype=complex)
    system, n = model.state_space(), model.order
    # Balance channels against states, or the pencil mixes volts with rad/s.
    rate = float(np.max(np.abs(model.poles_rad_s)))
    reach, seen = float(np.linalg.norm(system.B)), float(np.linalg.norm(system.C))
    B, C = system.B / reach, system.C / seen
    pencil = np.block([[system.A / rate, B], [C, system.D * rate / (reach * seen)]])
    mass = np.zeros_like(pencil)
    mass[:n, :n] = np.eye(n)
    real, imaginary, bottom, *_ = dggev(pencil, mass, compute_vl=0, compute_vr=0)
    top = real + 1j * imaginary
    finite = np.abs(bottom) > 1e-9 * np.maximum(np.abs(top), 1e-300)
    zeros = rate * top[finite] / bottom[finite]
    return np.asarray(np.sort_complex(zeros[np.abs(zeros) <= below_rad_s]).astype(complex))


def _slopes(model: ModalModel, points: Complexes, direct: bool) -> Complexes:
    """Derivative of the transfer matrix at the points by each parameter: (points, outputs, inputs, parameters)."""
    b, c, m = model.input_vectors.T, model.output_vectors, model.real_poles
    (outputs, inputs), (n, count) = model.direct.shape, (model.poles_rad_s.size, len(points))
    basis = 1.0 / (points[:, None] - model.poles_rad_s)
    mirrored = 1.0 / (points[:, None] - model.poles_rad_s.conj())

    def by(vectors: Complexes, power: int, others: int = 1) -> Complexes:
        """Slopes by the real parts of what the vectors (outputs, inputs, modes x others) go with, then the others."""
        near, far = basis**power, mirrored**power
        if others > 1:
            near, far = np.repeat(near, others, axis=1), np.repeat(far, others, axis=1)
        up = vectors * near[:, None, None, :]
        down = vectors[..., m * others :].conj() * far[:, None, None, m * others :]
        above = up[..., m * others :]
        return np.concatenate([up[..., : m * others], above + down, 1j * (above - down)], axis=-1)

    each = np.eye(inputs)[None, :, None, :]
    parts = [by(c[:, None, :] * b, 2), by((c[:, None, :, None] * each).reshape(outputs, inputs, -1), 1, inputs)]
    for q in range(outputs):
        chosen = np.eye(outputs)[:, q : q + 1, None]
        parts.append(by(chosen * b, 1))
        if direct:
            parts.append(np.broadcast_to(chosen * np.eye(inputs), (count, outputs, inputs, inputs)))
    assert sum(part.shape[-1] for part in parts) == (2 * n - m) * (1 + inputs + outputs) + outputs * inputs * direct
    return np.concatenate(parts, axis=-1)


def _variance(slopes: Complexes, covariance: Floats) -> Floats:
    """Variance of the real part plus that of the imaginary part, over the last axis of the slopes."""
    return np.asarray(np.sum((slopes @ covariance) * slopes.conj(), axis=-1).real)


def _zero_errors(model: ModalModel, zeros: Complexes, slopes: Complexes, covariance: Floats) -> Floats:
    """At a zero w^H G v = 0, so dz = -(w^H dG v) / (w^H G' v)."""
    if zeros.size == 0:
        return np.zeros(0)
    left, _, right = np.linalg.svd(transfer_matrix(model, zeros))
    w, v = left[:, :, -1].conj(), right[:, -1].conj()
    inputs, outputs = model.all_vectors
    near = 1.0 / (zeros[:, None] - model.all_poles_rad_s)
    slope = -np.sum((w @ outputs) * near**2 * (v @ inputs.T), axis=1)
    moved = np.sum(w[:, :, None, None] * slopes * v[:, None, :, None], axis=(1, 2)) / slope[:, None]
    return np.sqrt(np.maximum(_variance(moved, covariance), 0.0))
