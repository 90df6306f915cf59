"""Standard errors of poles, transmission zeros and gains of a polished model, by first-order propagation.

The covariance of the parameters is s^2 N^+ with the normal matrix N of the least squares, s^2 what is left per degree
of freedom and N^+ its pseudo-inverse (the scale of each mode's input vector is free and drops out). It counts what the
model cannot explain as if it were white noise: where distortion or a missing mode dominates, it is a scale, not a
bound.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from microrad.lab.identify.modal import Complexes, Floats, ModalModel
from microrad.lab.identify.polish import Polished, pack, unpack
from microrad.lab.identify.response import FrequencyResponse

_NULL = 1e-11
_STEP = 1e-6


@dataclass(frozen=True, eq=False)
class Uncertainty:
    """Poles and zeros (rad/s) and gains (outputs, inputs) with standard errors of the (complex) value."""

    poles: Complexes
    poles_error: Floats
    zeros: Complexes
    zeros_error: Floats
    dc_gain: Floats
    dc_gain_error: Floats
    edge_gain: Floats
    edge_gain_error: Floats
    covariance: Floats


def uncertainty(polished: Polished, response: FrequencyResponse, direct: bool, inflation: float) -> Uncertainty:
    """Values and standard errors; `inflation` is the factor by which colour raises the variance (1 for white)."""
    model = polished.model
    covariance = parameter_covariance(polished) * inflation
    m, n = model.real_poles, model.poles_rad_s.size
    variance = np.diag(covariance)[: 2 * n - m]
    spread = variance[:n].copy()
    spread[m:] += variance[n:]
    spread = np.sqrt(np.maximum(np.concatenate([spread, spread[m:]]), 0.0))
    zeros = transmission_zeros(model, np.pi * response.rate_hz)
    points = np.concatenate([[0.0, 2j * np.pi * response.excited_hz[0]], zeros])
    slopes = _slopes(model, points, direct)
    values = at(model, points[:2])
    errors = [np.sqrt(np.maximum(_variance(slopes[k], covariance), 0.0)) for k in (0, 1)]
    # A gain is real in phase: only the change along the value moves its magnitude.
    direction = values[1].conj() / np.maximum(np.abs(values[1]), 1e-300)
    along = np.real(direction[:, :, None] * slopes[1])
    errors[1] = np.sqrt(np.maximum(_variance(along, covariance), 0.0))
    return Uncertainty(
        model.all_poles_rad_s,
        spread,
        zeros,
        _zero_errors(model, zeros, slopes[2:], covariance),
        values[0].real,
        errors[0],
        np.abs(values[1]),
        errors[1],
        covariance,
    )


def parameter_covariance(polished: Polished) -> Floats:
    """Covariance of the parameters of `pack`."""
    size = np.sqrt(np.maximum(np.diag(polished.normal), 1e-300))
    values, vectors = np.linalg.eigh(polished.normal / np.outer(size, size))
    kept = values > _NULL * values[-1]
    inverse = (vectors[:, kept] / values[kept]) @ vectors[:, kept].T / np.outer(size, size)
    freedom = max(polished.rows - int(np.count_nonzero(kept)), 1)
    return np.asarray(inverse * polished.cost / freedom)


def at(model: ModalModel, points: Complexes) -> Complexes:
    """Transfer matrix at any complex frequencies (rad/s), shape (points, outputs, inputs)."""
    pairs = slice(model.real_poles, None)
    b = np.vstack([model.input_vectors, model.input_vectors[pairs].conj()])
    c = np.hstack([model.output_vectors, model.output_vectors[:, pairs].conj()])
    basis = 1.0 / (np.asarray(points)[:, None] - model.all_poles_rad_s)
    return np.asarray((c * basis[:, None, :]) @ b + model.direct)


def transmission_zeros(model: ModalModel, below_rad_s: float) -> Complexes:
    """Complex frequencies at which the square transfer matrix loses rank, up to `below_rad_s`; none where not
    square.
    """
    from scipy.linalg import eig  # here, to keep start-up cheap

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
    top, bottom = eig(pencil, mass, right=False, homogeneous_eigvals=True)
    finite = np.abs(bottom) > 1e-9 * np.maximum(np.abs(top), 1e-300)
    zeros = rate * top[finite] / bottom[finite]
    return np.asarray(np.sort_complex(zeros[np.abs(zeros) <= below_rad_s]).astype(complex))


def _slopes(model: ModalModel, points: Complexes, direct: bool) -> Complexes:
    """Derivative of the transfer matrix at the points by each parameter: (points, outputs, inputs, parameters)."""
    theta = pack(model, direct)
    slopes = np.empty((points.size, *model.direct.shape, theta.size), dtype=complex)
    for k, value in enumerate(theta):
        step = _STEP * max(abs(value), 1e-9)
        ends = []
        for sign in (1.0, -1.0):
            moved = theta.copy()
            moved[k] += sign * step
            ends.append(at(unpack(moved, model), points))
        slopes[..., k] = (ends[0] - ends[1]) / (2 * step)
    return slopes


def _variance(slopes: Complexes, covariance: Floats) -> Floats:
    """Variance of the real part plus that of the imaginary part, over the last axis of the slopes."""
    return np.asarray(np.einsum("...i,ij,...j->...", slopes, covariance, slopes.conj(), optimize=True).real)


def _zero_errors(model: ModalModel, zeros: Complexes, slopes: Complexes, covariance: Floats) -> Floats:
    """At a zero w^H G v = 0, so dz = -(w^H dG v) / (w^H G' v)."""
    errors = np.empty(zeros.size)
    for k, zero in enumerate(zeros):
        left, _, right = np.linalg.svd(at(model, np.array([zero]))[0])
        w, v = left[:, -1].conj(), right[-1].conj()
        step = 1e-6 * max(abs(zero), 1e-6)
        ends = at(model, np.array([zero + step, zero - step]))
        slope = w @ ((ends[0] - ends[1]) / (2 * step)) @ v
        moved = np.einsum("o,oip,i->p", w, slopes[k], v) / slope
        errors[k] = np.sqrt(max(float(_variance(moved, covariance)), 0.0))
    return errors
