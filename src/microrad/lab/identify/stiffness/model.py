"""The numbers of a mirror with hysteretic stiffness, the mirror they make, and where a fit of them begins.

    x' = A x + B u(t - delay) + E z      q = F x + G u(t - delay)      z = P[q]      y = C x + D u(t - delay) + K z

A is block-diagonal, a block [[s, -w], [w, s]] for each pair of poles and then the real poles; P is a bank of
Prandtl-Ishlinskii operators with fixed thresholds. All entries of B, E, F, G, C, D, K and the weights are free: plays
of small strain and of the drive that act on every mode, which is hysteresis in the stiffness with its channels mixed.
Two scales are not: that of each mode (its state) and that of each operator (z). `balanced` fixes them.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal, NamedTuple

import numpy as np

from microrad.core import lti
from microrad.core.arrays import Complexes, Floats
from microrad.lab.identify.linear.modal import ModalModel
from microrad.lab.identify.linear.order import fit_order
from microrad.lab.identify.linear.response import FrequencyResponse
from microrad.mirror.hysteresis import Play
from microrad.mirror.model import Mirror

HysteresisSource = Literal["strain", "drive"]

_FASTEST = 3
FIELDS = ("decay", "frequency", "B", "E", "F", "G", "weights", "C", "D", "K")


class LinearStart(NamedTuple):
    """A linear model behind a delay, for a drive that is straight over each step; and the lowest excited frequency."""

    model: ModalModel
    delay_s: float
    lowest_hz: float


class Growth(NamedTuple):
    """Real part of a pole (1/s), and its derivative by each of the numbers."""

    rate_1_s: float
    slope: Floats


@dataclass(frozen=True, eq=False)
class Numbers:
    """The free numbers of a model, with the thresholds and the delay.

    ``decay`` holds s of all pairs and then of the real poles, ``frequency`` w of the pairs (rad/s); ``weights`` and
    ``thresholds`` have the shape (operators, plays).
    """

    decay: Floats
    frequency: Floats
    B: Floats
    E: Floats
    F: Floats
    G: Floats
    weights: Floats
    C: Floats
    D: Floats
    K: Floats
    thresholds: Floats
    delay_s: float

    @property
    def poles(self) -> Complexes:
        """Pole of each pair with positive frequency, then the real poles (rad/s)."""
        pole = self.decay.astype(complex)
        pole[: self.frequency.size] += 1j * self.frequency
        return pole

    @property
    def rows(self) -> list[int]:
        """First state of each mode."""
        pairs = self.frequency.size
        return [2 * i for i in range(pairs)] + [pairs + i for i in range(pairs, self.decay.size)]

    @property
    def redundant(self) -> int:
        """Numbers that change nothing: scale and phase of the state of each pair, scale of the others, scale of z."""
        return int(self.frequency.size + self.decay.size + self.weights.shape[0])

    def vector(self) -> Floats:
        """All free numbers in the order of `FIELDS`, and the delay."""
        return np.concatenate([*(getattr(self, name).ravel() for name in FIELDS), [self.delay_s]])

    def at(self, vector: Floats) -> "Numbers":
        """The same model with other numbers."""
        parts, start = {}, 0
        for name in FIELDS:
            shape, size = getattr(self, name).shape, getattr(self, name).size
            parts[name] = vector[start : start + size].reshape(shape).copy()
            start += size
        return replace(self, **parts, delay_s=float(vector[start]))

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the numbers of `vector` as in a mirror file, see `mirror.coupled.Known`."""
        modes = range(1, self.decay.size + 1)
        found = [f"modes.decay.{k}" for k in modes] + [f"modes.frequency.{k}" for k in modes[: self.frequency.size]]
        for name in ("B", "E", "F", "G"):
            found += [f"matrices.{name}.{i + 1}.{j + 1}" for i, j in np.ndindex(getattr(self, name).shape)]
        found += [f"hysteresis.{i + 1}.weights.{j + 1}" for i, j in np.ndindex(self.weights.shape)]
        for name in ("C", "D", "K"):
            found += [f"matrices.{name}.{i + 1}.{j + 1}" for i, j in np.ndindex(getattr(self, name).shape)]
        return (*found, "recording.delay")

    @property
    def growth_1_s(self) -> float:
        """Largest real part of a pole, the plays of each operator all stuck or all sliding.

        Plays that slide follow q, so that z = W q with W the sum of their weights and x' = (A + E W F) x. Above 0 a
        large drive starts what no drive stops; see `lti.growth_1_s`. Below 0 no drive runs away: a play differs from q
        by no more than its threshold, which is a bounded drive of a mirror whose modes decay.
        """
        return lti.growth_1_s(self.mirror("").A, self.E, self.F, self.weights.sum(axis=1))

    def growths(self) -> list["Growth"]:
        """The fastest-growing poles of each combination of operators that slide, and how each number moves them.

        With left and right vectors l and r of a pole p of M = A + E W F, dp = l* dM r / l* r.
        """
        from scipy.linalg import eig

        sums, A = self.weights.sum(axis=1), self.mirror("").A
        found = []
        for case in lti.sliding_cases(sums.size):
            poles, left, right = eig(A + (self.E * (case * sums)) @ self.F, left=True)
            rank = np.argsort(np.where(poles.imag >= 0.0, -poles.real, np.inf), kind="stable")
            for k in rank[:_FASTEST]:
                size = left[:, k].conj() @ right[:, k]
                P = (left[:, k].conj()[:, None] * right[:, k] / (size if size else 1e-300)).real
                found.append(Growth(float(poles[k].real), self._slope(P, case, sums)))
        return found

    def _slope(self, P: Floats, case: Floats, sums: Floats) -> Floats:
        """Derivative by each number of the real part of a pole whose derivative by the matrix is P."""
        first, pairs = self.rows, self.frequency.size
        second = [row + 1 for row in first[:pairs]]
        decay = P[first, first]
        decay[:pairs] += P[second, second]
        through = np.einsum("ie,ij,ej->e", self.E, P, self.F) * case
        parts = {
            "decay": decay,
            "frequency": P[second, first[:pairs]] - P[first[:pairs], second],
            "E": (P @ self.F.T) * (case * sums),
            "F": (self.E.T @ P) * (case * sums)[:, None],
            "weights": np.repeat(through[:, None], self.weights.shape[1], axis=1),
        }
        each = [parts.get(name, np.zeros_like(getattr(self, name))).ravel() for name in FIELDS]
        return np.concatenate([*each, [0.0]])

    def mirror(self, name: str) -> Mirror:
        """The mirror in the plant form, without its delay."""
        pairs, order = self.frequency.size, self.B.shape[0]
        A = np.zeros((order, order))
        for row, s in zip(self.rows, self.decay, strict=True):
            A[row, row] = s
        for i, w in enumerate(self.frequency):
            A[2 * i + 1, 2 * i + 1] = self.decay[i]
            A[2 * i, 2 * i + 1], A[2 * i + 1, 2 * i] = -w, w
        assert order == pairs + self.decay.size
        plays = tuple(
            Play(tuple(r.tolist()), tuple(w.tolist())) for r, w in zip(self.thresholds, self.weights, strict=True)
        )
        return Mirror(name, A, self.B, self.E, self.F, self.G, self.C, self.D, self.K, (), plays, ())


def scaled(numbers: Numbers, drive: float, output: float) -> Numbers:
    """The same model with drive and output counted in other units.

    A model of u / U and y / Y becomes one of u and y with drive = U and output = Y; q and z are then counted as u is.

    Args:
        numbers: The model's numbers.
        drive: How many of the new units of the drive make one of the old.
        output: How many of the new units of the output make one of the old.
    """
    return replace(
        numbers,
        B=numbers.B / drive,
        E=numbers.E / drive,
        F=numbers.F * drive,
        thresholds=numbers.thresholds * drive,
        C=numbers.C * output,
        D=numbers.D * output / drive,
        K=numbers.K * output / drive,
    )


def balanced(numbers: Numbers) -> Numbers:
    """The same model with the state of each mode, and z of each operator, at a scale that suits both of its sides."""
    state = np.ones(numbers.B.shape[0])
    for i, row in enumerate(numbers.rows):
        wide = slice(row, row + (2 if i < numbers.frequency.size else 1))
        size = np.linalg.norm(numbers.B[wide])
        state[wide] = np.sqrt(np.linalg.norm(numbers.C[:, wide]) / size) if size > 0 else 1.0
    B, E = numbers.B * state[:, None], numbers.E * state[:, None]
    C, F = numbers.C / state, numbers.F / state
    weight = np.linalg.norm(numbers.weights, axis=1)
    z = np.sqrt(np.linalg.norm(E, axis=0) / np.where(weight > 0, weight, 1.0))
    z = np.where(z > 0, z, 1.0)
    return replace(numbers, B=B, C=C, F=F, E=E / z, K=numbers.K / z, weights=numbers.weights * z[:, None])


# ---------------------------------------------------------------------------------------------------------- the start
def linear_start(
    response: FrequencyResponse, order: int, sub_steps: int, delay_s: float | None, exchanges: int
) -> LinearStart:
    """Linear model behind a pure delay.

    The drive is taken as straight over each of the steps of a sample.

    Args:
        response: The measured frequency response.
        order: Number of states of the model.
        sub_steps: Steps of the simulation in each sample.
        delay_s: The delay, in s; None for the best on a grid of a quarter of a sample up to two samples.
        exchanges: Largest number of modes exchanged in the fit of the model.
    """
    if delay_s is None:
        delay_s = best_delay(response, order, sub_steps)
    model = fit_order(without_delay(response, delay_s, sub_steps), order, exchanges=exchanges).model
    return LinearStart(model, delay_s, response.excited_hz[0])


def best_delay(response: FrequencyResponse, order: int, sub_steps: int) -> float:
    """The delay (s) on a grid of a quarter of a sample up to two samples behind which a linear model fits best.

    Args:
        response: The measured response.
        order: Number of states of the models.
        sub_steps: Steps of the plant in each sample.
    """
    tried = np.arange(0.0, 2.01, 0.25) / response.rate_hz
    costs = [fit_order(without_delay(response, d, sub_steps), order, exchanges=0, fine=False).cost for d in tried]
    return float(tried[int(np.argmin(costs))])


def without_delay(response: FrequencyResponse, delay_s: float, sub_steps: int) -> FrequencyResponse:
    """The response of what is behind a delay, to a drive that is straight over each step of the plant.

    Args:
        response: The measured response.
        delay_s: The delay, in s.
        sub_steps: Steps of the plant in each sample.
    """
    ahead = np.exp(2j * np.pi * response.freq_hz * delay_s)[:, None, None]
    values = np.asarray(response.response * ahead)
    return replace(response, response=values, hold="first-order", rate_hz=sub_steps * response.rate_hz)


def starting_numbers(start: LinearStart, sources: Sequence[HysteresisSource], plays: int) -> Numbers:
    """Numbers to begin with: a linear model, and for each actuator and source an operator of next to no weight.

    Each operator acts as the drive of its actuator does. The strain of the actuators is what, at low frequency, the
    drive makes of them: q = M y with M the (pseudo-)inverse of the quasi-static gain. Thresholds are left at zero.

    Args:
        start: The linear model and its delay. The quasi-static gain is its mean from the lowest excited frequency on.
        sources: What drives the operators: the strain of the actuators or their drive.
        plays: Number of plays in each operator.
    """
    model, delay_s, lowest_hz = start
    pairs = np.flatnonzero(model.poles_rad_s.imag != 0)
    real = np.flatnonzero(model.poles_rad_s.imag == 0)
    b, c, poles = model.input_vectors, model.output_vectors, model.poles_rad_s
    B = np.concatenate([np.stack([b[pairs].real, b[pairs].imag], axis=1).reshape(-1, b.shape[1]), b[real].real])
    twice = np.stack([2 * c[:, pairs].real, -2 * c[:, pairs].imag], axis=2).reshape(c.shape[0], -1)
    C = np.concatenate([twice, c[:, real].real], axis=1)
    highest_hz = max(0.1 * float(np.abs(poles).min()) / (2 * np.pi), 2 * lowest_hz)
    static = model.response(np.linspace(lowest_hz, highest_hz, 16)).real.mean(axis=0)
    strain, inputs = np.linalg.pinv(static), b.shape[1]
    blocks = {"strain": (strain @ C, strain @ model.direct), "drive": (np.zeros((inputs, C.shape[1])), np.eye(inputs))}
    count = len(sources)
    return Numbers(
        decay=np.concatenate([poles[pairs].real, poles[real].real]),
        frequency=poles[pairs].imag.copy(),
        B=B,
        E=np.hstack([B] * count),
        F=np.vstack([blocks[s][0] for s in sources]),
        G=np.vstack([blocks[s][1] for s in sources]),
        weights=np.full((count * inputs, plays), 1e-3),
        C=C,
        D=model.direct.copy(),
        K=np.hstack([model.direct] * count),
        thresholds=np.zeros((count * inputs, plays)),
        delay_s=delay_s,
    )
