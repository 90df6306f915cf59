"""Trust-region polish of a modal model: output error in frequency or in time, with the analytic Jacobian.

The output is linear in the output vectors and the direct term, so these are solved exactly at each trial point
(variable projection: G. Golub and V. Pereyra, Inverse Problems 19 (2003) R1) and the trust region
(Levenberg-Marquardt) moves poles and input vectors. Rows of equations come in blocks, one for each record; only the
normal equations are kept.

Each mode is written with real filters, R = phi(p) + phi(p*) and I = i (phi(p) - phi(p*)), and one for a real pole:
Re(c b) R + Im(c b) I. `phi` is the sampled response of 1/(s - p) behind the hold.
"""

from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np

from microrad.core.arrays import Complexes, Floats
from microrad.lab.identify.linear.modal import Hold, ModalModel, filtered, hold_basis, order_modes, real_columns
from microrad.lab.recording import Recording

_LOWEST_DECAY = 0.01  # of the lowest frequency that the data resolve


_NOTHING = 1e-4  # of the cost per row


class Block(NamedTuple):
    """Some rows of equations: the drive behind each real filter, its derivative, the drive and the output.

    Shapes (filters, inputs, rows), the same or None, (inputs, rows) and (outputs, rows).
    """

    behind: Floats
    rates: Floats | None
    drive: Floats
    target: Floats


class Equations(Protocol):
    """Output-error equations: how the drive looks behind filters with given poles."""

    decay_rad_s: float
    direct: bool
    rows: int
    power: float

    def blocks(self, poles_rad_s: Complexes, rates: bool) -> Iterator[Block]:
        """The rows of the equations for some poles.

        Args:
            poles_rad_s: Poles of the modes, in rad/s, shape (modes,), real ones first, of each pair one.
            rates: Whether the derivatives by the poles are wanted.
        """


class SummedEquations(ABC):
    """Equations that make the sums of the polish themselves, where that is faster than block by block."""

    decay_rad_s: float
    direct: bool
    rows: int
    power: float

    @abstractmethod
    def blocks(self, poles_rad_s: Complexes, rates: bool) -> Iterator[Block]:
        """See `Equations`."""

    @abstractmethod
    def fit_outputs(self, poles: Complexes, inputs: Complexes) -> tuple[ModalModel, float]:
        """See the function of that name."""

    @abstractmethod
    def normal_equations(self, model: ModalModel) -> tuple[Floats, Floats, float]:
        """See the function of that name."""


@dataclass(frozen=True, eq=False)
class Polished:
    """A polished model with the sum of squares left, that of the output, and the normal matrix at the end.

    `normal` belongs to the parameter vector of `pack`; its null directions are the scales of the input vectors.
    """

    model: ModalModel
    cost: float
    power: float
    rows: int
    normal: Floats
    iterations: int


class FrequencyEquations:
    """Weighted distance to a measured response: trace(E P E^H) summed over frequencies is the mean-square output
    error.
    """

    def __init__(
        self,
        freq_hz: Floats,
        response: Complexes,
        drive_power: Complexes,
        hold: Hold,
        rate_hz: float | None,
        *,
        direct: bool = True,
    ) -> None:
        """`drive_power` (frequencies, inputs, inputs) weighs the error; without `direct` the fit is strictly proper."""
        self.direct = direct
        self.freq_hz, self.hold, self.rate_hz = freq_hz, hold, rate_hz
        floor = 1e-12 * np.trace(drive_power, axis1=1, axis2=2).real[:, None, None] * np.eye(drive_power.shape[1])
        self._factor = np.asarray(np.linalg.cholesky(drive_power + floor), dtype=np.complex128)
        self._target = _real_rows((response @ self._factor).transpose(1, 0, 2))
        self._drive = _real_rows(self._factor.transpose(1, 0, 2))[: None if direct else 0]
        self.power = float(np.sum(self._target**2))
        self.rows = self._target.size
        self.decay_rad_s = 2 * np.pi * float(freq_hz.min()) * _LOWEST_DECAY

    def blocks(self, poles_rad_s: Complexes, rates: bool) -> Iterator[Block]:
        """One block: real and imaginary parts of all lines.

        Args:
            poles_rad_s: Poles of the modes, in rad/s, shape (modes,), real ones first, of each pair one.
            rates: Whether the derivatives by the poles are wanted.
        """
        real = int(np.count_nonzero(poles_rad_s.imag == 0))
        every = np.concatenate([poles_rad_s, poles_rad_s[real:].conj()])
        basis, slope = hold_basis(every, self.freq_hz, self.hold, self.rate_hz, rates=rates)
        yield Block(
            self._rows(basis, real), None if slope is None else self._rows(slope, real), self._drive, self._target
        )

    def _rows(self, basis: Complexes, real: int) -> Floats:
        return _real_rows(
            np.asarray(real_columns(basis, real).T[:, None, :, None] * self._factor.transpose(1, 0, 2)[None])
        )


def _real_rows(values: Complexes) -> Floats:
    """The last two axes as one, real parts before imaginary ones."""
    flat = values.reshape(*values.shape[:-2], -1)
    return np.concatenate([flat.real, flat.imag], axis=-1)


class TimeEquations:
    """Output error in time from rest: measured less simulated samples, less their mean in each record.

    The first `drop` samples of each record do not count.
    """

    def __init__(self, records: Sequence[Recording], hold: Hold, drop: int = 0, *, direct: bool = True) -> None:
        """Without `direct` the fit is strictly proper."""
        self.hold, self.drop, self.direct = hold, drop, direct
        self.records = [
            (r.drive - r.drive[:1], r.output[drop:] - r.output[drop:].mean(axis=0), r.rate_hz) for r in records
        ]
        self.power = sum(float(np.sum(y**2)) for _, y, _ in self.records)
        self.rows = sum(y.size for _, y, _ in self.records)
        self.decay_rad_s = _LOWEST_DECAY * 2 * np.pi * min(rate / len(y) for _, y, rate in self.records)

    def blocks(self, poles_rad_s: Complexes, rates: bool) -> Iterator[Block]:
        """One block for each record.

        Args:
            poles_rad_s: Poles of the modes, in rad/s, shape (modes,), real ones first, of each pair one.
            rates: Whether the derivatives by the poles are wanted.
        """
        real = int(np.count_nonzero(poles_rad_s.imag == 0))
        for drive, output, rate_hz in self.records:
            behind, slopes = filtered(poles_rad_s, drive, self.hold, rate_hz, rates=rates)
            yield Block(
                self._real(behind, real),
                None if slopes is None else self._real(slopes, real),
                _centred(drive.T[: None if self.direct else 0, self.drop :]),
                output.T,
            )

    def _real(self, states: Complexes, real: int) -> Floats:
        states = states[:, :, self.drop :]
        parts = [states[:real].real, 2 * states[real:].real, -2 * states[real:].imag]
        return _centred(np.concatenate(parts))


def _centred(values: Floats) -> Floats:
    return np.asarray(values - values.mean(axis=-1, keepdims=True))


# ---------------------------------------------------------------------------------------------------- normal equations
def pack(model: ModalModel, direct: bool) -> Floats:
    """The parameters of a model as one vector.

    They are poles (real part, frequency of pairs), input vectors (real, imaginary of pairs), then per output the output
    vector (real parts, imaginary parts of pairs) and the direct term, where that is free.

    Args:
        model: The modal model.
        direct: Whether the direct term is free.
    """
    m = model.real_poles
    b, c = model.input_vectors, model.output_vectors
    own = np.hstack([c.real, c[:, m:].imag, model.direct[:, : None if direct else 0]])
    shared = [model.poles_rad_s.real, model.poles_rad_s[m:].imag, b.real.ravel(), b[m:].imag.ravel()]
    return np.concatenate([*shared, own.ravel()])


def unpack(theta: Floats, like: ModalModel) -> ModalModel:
    """The model that a parameter vector stands for.

    Args:
        theta: Parameters, as `pack` orders them.
        like: A model with as many real poles, pairs, inputs and outputs.
    """
    n, m = like.poles_rad_s.size, like.real_poles
    outputs, inputs = like.direct.shape
    sizes = [n, n - m, n * inputs, (n - m) * inputs]
    sigma, omega, b_real, b_imag, own = np.split(theta, np.cumsum(sizes))
    poles = sigma.astype(complex)
    poles[m:] += 1j * omega
    b = b_real.reshape(n, inputs).astype(complex)
    b[m:] += 1j * b_imag.reshape(n - m, inputs)
    return with_outputs(poles, b, own.reshape(outputs, -1), m)


def with_outputs(poles: Complexes, b: Complexes, own: Floats, real: int) -> ModalModel:
    """The model of some poles and input vectors with what `pack` has of each output.

    Args:
        poles: Poles of the modes, in rad/s, shape (modes,), real ones first, of each pair one.
        b: Input vectors, shape (modes, inputs).
        own: Output vectors and, where it is free, the direct term, shape (outputs, numbers).
        real: Number of real poles.
    """
    n = poles.size
    c = own[:, :n].astype(complex)
    c[:, real:] += 1j * own[:, n : 2 * n - real]
    direct = np.zeros((len(own), b.shape[1]))
    direct[:, : own.shape[1] - 2 * n + real] = own[:, 2 * n - real :]
    return ModalModel(poles, b, c, direct)


def behind_modes(behind: Floats, b: Complexes, real: int) -> Floats:
    """Rows of each mode's state: one for a real pole; for a pair those of Re c and of Im c, one block behind the other.

    Args:
        behind: The drives behind the filters, shape (filters, inputs, columns).
        b: Input vectors of the modes, shape (modes, inputs), those of real poles first.
        real: Number of real poles.
    """
    pairs = len(b) - real
    first, second = behind[real : real + pairs], behind[real + pairs :]
    gamma, delta = b[real:].real, b[real:].imag
    return np.concatenate(
        [
            _mixed(b[:real].real, behind[:real]),
            _mixed(gamma, first) + _mixed(delta, second),
            _mixed(gamma, second) - _mixed(delta, first),
        ]
    )


def _mixed(weights: Floats, rows: Floats) -> Floats:
    return np.asarray(np.einsum("ki,kir->kr", weights, rows))


def fit_outputs(equations: Equations, poles: Complexes, inputs: Complexes) -> tuple[ModalModel, float]:
    """Best output vectors and direct term for given poles and input vectors, and the sum of squares left.

    Args:
        equations: The equations to be met.
        poles: Poles of the modes, in rad/s, shape (modes,), real ones first, of each pair one.
        inputs: Input vectors, shape (modes, inputs).
    """
    if isinstance(equations, SummedEquations):
        return equations.fit_outputs(poles, inputs)
    real = int(np.count_nonzero(poles.imag == 0))
    gram: Floats | float = 0.0
    cross: Floats | float = 0.0
    for block in equations.blocks(poles, rates=False):
        own = np.concatenate([behind_modes(block.behind, inputs, real), block.drive])
        gram = gram + own @ own.T
        cross = cross + own @ block.target.T
    gram, cross = np.asarray(gram), np.asarray(cross)
    size = np.sqrt(np.maximum(np.diag(gram), 1e-300))
    scaled = gram / np.outer(size, size) + 1e-13 * np.eye(size.size)
    solved = np.linalg.solve(scaled, cross / size[:, None]) / size[:, None]
    left = equations.power - 2 * float(np.sum(solved * cross)) + float(np.sum(solved * (gram @ solved)))
    return with_outputs(poles, inputs, solved.T, real), max(left, 0.0)


def normal_equations(equations: Equations, model: ModalModel) -> tuple[Floats, Floats, float]:
    """Normal matrix, gradient of half the cost, and cost, in the parameters of `pack`.

    Args:
        equations: The equations to be met.
        model: The model about which they are made linear.
    """
    if isinstance(equations, SummedEquations):
        return equations.normal_equations(model)
    n, m = model.poles_rad_s.size, model.real_poles
    outputs, inputs = model.direct.shape
    shared, width = (2 * n - m) * (1 + inputs), 2 * n - m + inputs * equations.direct
    size = shared + outputs * width
    normal, gradient, cost = np.zeros((size, size)), np.zeros(size), 0.0
    free = model.direct[:, : None if equations.direct else 0]
    weights = np.hstack([model.output_vectors.real, model.output_vectors[:, m:].imag, free])
    for block in equations.blocks(model.poles_rad_s, rates=True):
        own = np.concatenate([behind_modes(block.behind, model.input_vectors, m), block.drive])
        assert block.rates is not None
        moved = behind_modes(block.rates, model.input_vectors, m)
        left = weights @ own - block.target
        cost += float(np.sum(left**2))
        own_gram = own @ own.T
        for q in range(outputs):
            rows = _shared_rows(block.behind, moved, model.output_vectors[q], m)
            place = slice(shared + q * width, shared + (q + 1) * width)
            cross = rows @ own.T
            normal[:shared, :shared] += rows @ rows.T
            normal[:shared, place] += cross
            normal[place, :shared] += cross.T
            normal[place, place] += own_gram
            gradient[:shared] += rows @ left[q]
            gradient[place] += own @ left[q]
    return normal, gradient, cost


def _shared_rows(behind: Floats, moved: Floats, c: Complexes, real: int) -> Floats:
    """Derivatives of one output by poles and input vectors, in the order of `pack`."""
    pairs = c.size - real
    alpha, beta = c[real:].real[:, None], c[real:].imag[:, None]
    first, second = behind[real : real + pairs], behind[real + pairs :]
    up, turned = moved[real : real + pairs], moved[real + pairs :]
    rows = behind.shape[2]
    alpha3, beta3 = alpha[:, :, None], beta[:, :, None]
    return np.concatenate(
        [
            c[:real].real[:, None] * moved[:real],
            alpha * up + beta * turned,
            alpha * turned - beta * up,
            (c[:real].real[:, None, None] * behind[:real]).reshape(-1, rows),
            (alpha3 * first + beta3 * second).reshape(-1, rows),
            (alpha3 * second - beta3 * first).reshape(-1, rows),
        ]
    )


# -------------------------------------------------------------------------------------------------------- trust region
def polish(
    equations: Equations,
    model: ModalModel,
    *,
    iterations: int = 50,
    tolerance: float = 1e-6,
    settled: float = 0.0,
    fitted: bool = False,
) -> Polished:
    """Improve a model by least squares: Levenberg-Marquardt with the output vectors projected out.

    Poles stay stable: a step beyond the slowest decay that the data can show stops there.

    Args:
        equations: The equations to be met.
        model: The model to begin with.
        iterations: Largest number of steps.
        tolerance: The search ends when two steps in a row gain less than this share of the cost.
        settled: It also ends with the step for which the normal equations promise a gain of less than this share of the
            cost per row, and keeps those equations; without the step where the share is below 1e-4 (a hundredth of a
            standard error).
        fitted: Whether the model has the best output vectors and direct term for its poles and input vectors already.
    """
    if not fitted:
        model = _balanced(fit_outputs(equations, model.poles_rad_s, model.input_vectors)[0])
    normal, gradient, cost = normal_equations(equations, model)
    damping, small, done = 1e-3, 0, 0
    while done < iterations and small < 2:
        promised = _promised(normal, gradient) * equations.rows / max(cost, 1e-300) if settled else np.inf
        if promised < _NOTHING:
            break
        done += 1
        trial = None
        while trial is None and damping < 1e8:
            trial = _trial(equations, model, (normal, gradient, cost), damping)
            damping *= 6.0 if trial is None else 0.2
        if trial is None:
            break
        if promised < settled:
            model, cost = trial
            break
        damping = max(damping, 1e-10)
        gain = (cost - trial[1]) / max(cost, 1e-300)
        model = _balanced(trial[0])
        normal, gradient, cost = normal_equations(equations, model)
        small = small + 1 if gain < tolerance else 0
        if cost <= 1e-24 * equations.power:
            break
    return Polished(model, cost, equations.power, equations.rows, normal, done)


def _promised(normal: Floats, gradient: Floats) -> float:
    """What the step to the minimum of the linear problem would gain."""
    size = np.sqrt(np.maximum(normal.diagonal(), 1e-300))
    scaled = normal / (size[:, None] * size)
    scaled.flat[:: len(size) + 1] += 1e-12
    slope = gradient / size
    return float(slope @ np.linalg.solve(scaled, slope))


def _trial(
    equations: Equations, model: ModalModel, state: tuple[Floats, Floats, float], damping: float
) -> tuple[ModalModel, float] | None:
    """The model after one damped step and its cost, or None where that is not lower."""
    normal, gradient, cost = state
    size = np.sqrt(np.maximum(np.diag(normal), 1e-300))
    scaled = normal / np.outer(size, size) + damping * np.eye(size.size)
    theta = pack(model, equations.direct) - np.linalg.solve(scaled, gradient / size) / size
    moved = unpack(theta, model)
    poles = np.minimum(moved.poles_rad_s.real, -equations.decay_rad_s) + 1j * moved.poles_rad_s.imag
    real = model.real_poles
    poles[real:] = poles[real:].real + 1j * np.maximum(np.abs(poles[real:].imag), 1e-9 * np.abs(poles[real:].real))
    candidate, left = fit_outputs(equations, poles, moved.input_vectors)
    return (candidate, left) if left < cost else None


def _balanced(model: ModalModel) -> ModalModel:
    return order_modes(model.poles_rad_s, model.input_vectors, model.output_vectors, model.direct)
