"""Gradient of a record's squared error by all numbers of a model, from one pass back along the path.

It costs little more than the simulation, whatever the number of parameters, where the derivatives of the output
(`tangents`) cost as much as a simulation for each few of them.
"""

import math
from typing import NamedTuple

import numpy as np

from microrad.core import kernels
from microrad.core.arrays import Floats
from microrad.lab.identify.linear.modal import hold_step
from microrad.lab.identify.stiffness import tangents
from microrad.lab.identify.stiffness.model import FIELDS, Numbers
from microrad.lab.identify.stiffness.tangents import Steady


class Slope(NamedTuple):
    """Squared error of a record, summed over samples and outputs, and its derivative by each number of the model."""

    cost: float
    gradient: Floats


def squared_error_slope(plant: kernels.PlayPlant, numbers: Numbers, record: Steady) -> Slope:
    """Squared error of a record in its steady state, and its derivative in the order of `Numbers.vector`.

    Where the model overflows the error is infinite and has no derivative.

    Args:
        plant: The discrete plant of the model.
        numbers: The model's numbers.
        record: The record, one period of its steady state.
    """
    with np.errstate(all="ignore"):
        left, path, drive = tangents.steady_error(plant, record, numbers.delay_s)
        cost = float(np.sum(left**2))
    if not math.isfinite(cost):
        return Slope(math.inf, np.zeros(numbers.vector().size))
    period = drive.shape[0] // 2
    error = np.zeros_like(path.output)
    error[period :: record.sub_steps] = left
    found = _adjoint(plant, path, error)
    by_step = found.predicted @ plant.B1 + found.q @ plant.G + error @ plant.D
    by_step[:-1] += found.predicted[1:] @ plant.B0
    parts = _modal_parts(numbers, path, drive, found, record.step_s) | {
        "F": found.q.T @ path.x[:, : numbers.B.shape[0]],
        "G": found.q.T @ drive,
        "weights": np.einsum("ke,kej->ej", found.z, path.play.reshape(len(drive), *numbers.weights.shape)),
        "polynomial": np.einsum("ke,kej->ej", found.z, tangents.powers(path.q, numbers.reach)),
        "C": error.T @ path.state[:, : numbers.B.shape[0]],
        "D": error.T @ drive,
        "K": error.T @ path.z,
    }
    turn = -2j * np.pi * np.fft.rfftfreq(period, record.step_s)[:, None]
    later = np.fft.irfft(turn * np.fft.rfft(drive[:period], axis=0), period, axis=0)
    delay = float(np.sum((by_step[:period] + by_step[period:]) * later))
    gradient = 2.0 * np.concatenate([*(parts[name].ravel() for name in FIELDS), [delay]])
    return Slope(cost, gradient)


def _adjoint(plant: kernels.PlayPlant, path: kernels.Path, error: Floats) -> kernels.Adjoint:
    states, operators, plays = path.x.shape[1], path.z.shape[1], path.play.shape[1]
    adjoint = kernels.Adjoint(
        predicted=np.empty_like(path.x),
        state=np.empty_like(path.x),
        q=np.empty_like(path.q),
        z=np.empty_like(path.z),
        next_state=np.zeros(states),
        next_z=np.zeros(operators),
        next_play=np.zeros(plays),
    )
    kernels.adjoint_kernel(plant, path.moved, tangents.bend(plant, path), error, adjoint)
    return adjoint


def _modal_parts(
    numbers: Numbers, path: kernels.Path, drive: Floats, found: kernels.Adjoint, step_s: float
) -> dict[str, Floats]:
    """Derivatives by what acts in each mode: its pole, its rows of B and of E."""
    first, pairs, width = np.array(numbers.rows), numbers.frequency.size, drive.shape[1]
    second = np.arange(1, 2 * pairs, 2)

    def modal(states: Floats) -> np.ndarray:
        """Rows of states as one complex row for each mode."""
        value = np.asarray(states[first], dtype=np.complex128)
        value[:pairs] += 1j * states[second]
        return value

    def rows(values: np.ndarray) -> Floats:
        """A row of each mode as rows of its states."""
        wide = np.stack([values[:pairs].real, values[:pairs].imag], axis=1).reshape(2 * pairs, -1)
        return np.asarray(np.concatenate([wide, values[pairs:].real]))

    step = hold_step(numbers.poles, "first-order", 1.0 / step_s)
    begin, end, begin_rate, end_rate = (v[:, None] for v in (step.begin, step.end, step.begin_rate, step.end_rate))
    now, before = found.predicted[1:], np.hstack([drive[:-1], path.z[:-1]])
    held = modal(now.T @ before).conj()
    u0, z0 = held[:, :width], held[:, width:]
    u1, z1 = modal(found.predicted.T @ drive).conj(), modal(found.state.T @ np.diff(path.z, axis=0, prepend=0.0)).conj()
    own = np.einsum("ks,ks->s", now, path.state[:-1])
    kept = own[first].astype(complex)
    a, b = 2 * np.arange(pairs), second
    kept[:pairs] += own[second]
    kept[:pairs] += 1j * (
        np.einsum("km,km->m", now[:, a], path.state[:-1, b]) - np.einsum("km,km->m", now[:, b], path.state[:-1, a])
    )
    pole = step.keep_rate * kept
    pole += np.sum(modal(numbers.B) * (begin_rate * u0 + end_rate * u1), axis=1)
    pole += np.sum(modal(numbers.E) * ((begin_rate + end_rate) * z0 + end_rate * z1), axis=1)
    return {
        "decay": pole.real,
        "frequency": -pole.imag[:pairs],
        "B": rows((begin * u0 + end * u1).conj()),
        "E": rows(((begin + end) * z0 + end * z1).conj()),
    }
