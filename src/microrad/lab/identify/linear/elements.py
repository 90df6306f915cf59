"""Least squares on a table of a frequency response, each element at each frequency with a weight of its own.

Each element of a modal model is a row vector times the same few filters (see `polish`), and so is its derivative by any
parameter: J = T X, with X the filters, their derivatives by the pole and a constant at all frequencies, and T small. So
the normal matrix is the sum over the elements of T (X W X') T', and what is done at each frequency is X W X' alone,
once where the weights of all elements are alike but for a factor.
"""

from collections.abc import Iterator
from functools import lru_cache

import numpy as np

from microrad.core.arrays import Complexes, Floats, Integers
from microrad.lab.identify.linear.modal import Hold, ModalModel, hold_basis, real_columns
from microrad.lab.identify.linear.polish import Block, SummedEquations, with_outputs

_LOWEST_DECAY = 0.01  # of the lowest frequency above zero
_RIDGE = 1e-14


class ElementEquations(SummedEquations):
    """Distance of a modal model to a table, each entry times its weight; a unit of cost is a squared weighted error."""

    def __init__(
        self,
        freq_hz: Floats,
        response: Complexes,
        weight: Floats,
        hold: Hold,
        rate_hz: float | None,
        *,
        direct: bool = True,
    ) -> None:
        """`response` and `weight` (frequencies, outputs, inputs); without `direct` the fit is strictly proper."""
        self.freq_hz, self.hold, self.rate_hz, self.direct = freq_hz, hold, rate_hz, direct
        self.response, self.shape = response, (int(response.shape[1]), int(response.shape[2]))
        self.decay_rad_s = 2 * np.pi * float(freq_hz[freq_hz > 0].min()) * _LOWEST_DECAY
        self.rows = 2 * response.size
        squared = weight.reshape(freq_hz.size, -1).T ** 2  # (elements, frequencies)
        self.scale, alike = squared[:, :1] / squared[0, 0], squared[0] * (squared[:, :1] / squared[0, 0])
        if np.max(np.abs(squared - alike) / squared) < 1e-12:
            squared = squared[:1]
        else:
            self.scale = np.ones_like(self.scale)
        self.squared = np.concatenate([squared, squared], axis=1)  # (elements or 1, twice the frequencies)
        self.target = stacked(response.reshape(freq_hz.size, -1).T)
        self.weight = self.squared * self.scale
        self.heavy = self.target * self.weight
        self.power = float(np.sum(self.heavy * self.target))

    def filters(self, poles: Complexes, *, rates: bool) -> Floats:
        """Real rows (filters, twice the frequencies): values, derivatives where wanted, and a constant.

        Args:
            poles: Poles of the modes, in rad/s, shape (modes,), real ones first, of each pair one.
            rates: Whether the derivatives by the poles are wanted.
        """
        real = int(np.count_nonzero(poles.imag == 0))
        every = np.concatenate([poles, poles[real:].conj()])
        basis, slope = hold_basis(every, self.freq_hz, self.hold, self.rate_hz, rates=rates)
        parts = [real_columns(part, real).T for part in (basis, slope) if part is not None]
        return stacked(np.concatenate([*parts, np.ones((1, self.freq_hz.size))]))

    def grams(self, rows: Floats) -> Floats:
        """X W X' of some rows, shape (elements or 1, rows, rows); the factor of each element is left out."""
        return np.asarray((rows * self.squared[:, None, :]) @ rows.T)

    def fit_outputs(self, poles: Complexes, inputs: Complexes) -> tuple[ModalModel, float]:
        """Best output vectors and direct term for given poles and input vectors, and the sum of squares left.

        Args:
            poles: Poles of the modes, in rad/s, shape (modes,), real ones first, of each pair one.
            inputs: Input vectors, shape (modes, inputs).
        """
        outputs, count = self.shape
        real = int(np.count_nonzero(poles.imag == 0))
        rows = self.filters(poles, rates=False)
        states = len(rows) - 1
        mix = np.zeros((count, states + count * self.direct, states + 1))
        mix[:, :states, :states] = _mixes(inputs.T, real)
        if self.direct:
            mix[np.arange(count), states + np.arange(count), states] = 1.0
        grams = self.grams(rows) * self.scale[:, :, None]
        gram = (mix @ grams.reshape(outputs, count, *grams.shape[1:]) @ mix.transpose(0, 2, 1)).sum(axis=1)
        cross = np.einsum("ipk,oik->op", mix, (self.heavy @ rows.T).reshape(outputs, count, -1))
        size = np.sqrt(np.maximum(np.diagonal(gram, axis1=1, axis2=2), 1e-300))
        scaled = gram / (size[:, :, None] * size[:, None, :]) + _RIDGE * np.eye(gram.shape[1])
        own = np.linalg.solve(scaled, (cross / size)[:, :, None])[:, :, 0] / size
        left = np.einsum("op,ipk->oik", own, mix).reshape(outputs * count, -1) @ rows - self.target
        return with_outputs(poles, inputs, own, real), float(np.vdot(self.weight * left, left))

    def normal_equations(self, model: ModalModel) -> tuple[Floats, Floats, float]:
        """Normal matrix, gradient of half the cost, and cost, in the parameters of `pack`.

        Args:
            model: The model about which they are made linear.
        """
        rows = self.filters(model.poles_rad_s, rates=True)
        moves, values = _moves(model, len(rows))
        left = values.reshape(-1, len(rows)) @ rows - self.target
        heavy = left * self.weight
        grams = self.grams(rows) * self.scale[:, :, None]
        small = moves @ grams @ moves.transpose(0, 2, 1)
        slopes = (moves @ (heavy @ rows.T)[:, :, None])[:, :, 0]
        places, size = _places(self.shape, model.poles_rad_s.size, model.order, self.direct)
        normal, gradient = (
            np.zeros((size + 1, size + 1)),
            np.zeros(size + 1),
        )  # the last is a direct term that is not free
        for at, matrix, slope in zip(places, small, slopes, strict=True):
            normal[at[:, None], at] += matrix
            gradient[at] += slope
        return normal[:size, :size], gradient[:size], float(np.vdot(heavy, left))

    def against(self, model: ModalModel, values: Complexes) -> tuple[Floats, float]:
        """One more column of the equations, in the sums: against each parameter of `pack`, and against itself.

        Args:
            model: The model about which they are made linear.
            values: The column, shape (frequencies, outputs, inputs).
        """
        rows = self.filters(model.poles_rad_s, rates=True)
        moves, _ = _moves(model, len(rows))
        column = stacked(values.reshape(self.freq_hz.size, -1).T)
        heavy = column * self.weight
        places, size = _places(self.shape, model.poles_rad_s.size, model.order, self.direct)
        found = np.zeros(size + 1)
        np.add.at(found, places, (moves @ (heavy @ rows.T)[:, :, None])[:, :, 0])
        return found[:size], float(np.vdot(heavy, column))

    def blocks(self, poles_rad_s: Complexes, rates: bool) -> Iterator[Block]:
        """One block with the mean weight of the outputs: good enough to look for modes that are missing.

        Args:
            poles_rad_s: Poles of the modes, in rad/s, shape (modes,), real ones first, of each pair one.
            rates: Whether the derivatives by the poles are wanted.
        """
        outputs, count = self.shape
        rows = self.filters(poles_rad_s, rates=rates)
        root = np.sqrt(self.weight.reshape(outputs, count, -1).mean(axis=0))
        wide = np.einsum("kr,ij,ir->kijr", rows, np.eye(count), root).reshape(len(rows), count, -1)
        states = (len(rows) - 1) // (2 if rates else 1)
        target = (self.target.reshape(outputs, count, -1) * root).reshape(outputs, -1)
        slopes = wide[states:-1] if rates else None
        yield Block(wide[:states], slopes, wide[-1][: None if self.direct else 0], target)


def stacked(values: Complexes | Floats) -> Floats:
    """Real parts before imaginary ones, along the last axis."""
    return np.concatenate([values.real, values.imag], axis=-1)


def _mixes(vectors: Complexes, real: int) -> Floats:
    """What the coefficient 1 (and for a pair i) times each entry of some vectors makes of the filters.

    For vectors (vectors, modes) the shape is (vectors, states, states): rows for the real parts of all modes, then for
    the imaginary parts of the pairs; a pair x + i y has x on its first filter and y on its second.
    """
    modes = vectors.shape[1]
    pairs = modes - real
    found = np.zeros((len(vectors), modes + pairs, modes + pairs))
    first, second = np.arange(modes), np.arange(modes, modes + pairs)
    found[:, first, first] = vectors.real
    found[:, first[real:], second] = vectors[:, real:].imag
    found[:, second, first[real:]] = -vectors[:, real:].imag
    found[:, second, second] = vectors[:, real:].real
    return found


def _moves(model: ModalModel, count: int) -> tuple[Floats, Floats]:
    """The derivative of each element by the parameters that move it, and its value, as rows of the filters.

    The parameters are poles, input vectors of its input, output vectors of its output and the direct term; shapes
    (elements, parameters, filters) and (elements, filters).
    """
    b, c, real = model.input_vectors, model.output_vectors, model.real_poles
    outputs, inputs = model.direct.shape
    states = model.order
    product = (c[:, None, :] * b.T).reshape(outputs * inputs, -1)
    moves = np.zeros((outputs * inputs, 3 * states + 1, count))
    mixes = _mixes(np.concatenate([product, c, b.T]), real)
    by_product, by_output, by_input = np.split(mixes, [outputs * inputs, outputs * inputs + outputs])
    moves[:, :states, states : 2 * states] = by_product
    moves[:, states : 2 * states, :states] = np.repeat(by_output, inputs, axis=0)
    moves[:, 2 * states : 3 * states, :states] = np.tile(by_input, (outputs, 1, 1))
    moves[:, -1, -1] = 1.0
    values = np.zeros((outputs * inputs, count))
    modes = len(b)
    values[:, :states] = by_product[:, :modes].sum(axis=1)
    values[:, -1] = model.direct.ravel()
    return moves, values


@lru_cache(maxsize=64)
def _places(shape: tuple[int, int], modes: int, states: int, direct: bool) -> tuple[Integers, int]:
    """Where the parameters of each element stand in `pack`, shape (elements, parameters), and how many there are."""
    outputs, inputs = shape
    pairs, width = states - modes, states + inputs * direct
    shared = states * (1 + inputs)
    found = np.empty((outputs, inputs, 3 * states + 1), dtype=np.int64)
    found[:, :, :states] = np.arange(states)
    i = np.arange(inputs)[:, None]
    found[:, :, states : states + modes] = states + np.arange(modes) * inputs + i
    found[:, :, states + modes : 2 * states] = states + modes * inputs + np.arange(pairs) * inputs + i
    at = shared + np.arange(outputs)[:, None, None] * width
    found[:, :, 2 * states : 3 * states] = at + np.arange(states)
    found[:, :, -1:] = at + states + i if direct else shared + outputs * width
    return found.reshape(outputs * inputs, -1), shared + outputs * width
