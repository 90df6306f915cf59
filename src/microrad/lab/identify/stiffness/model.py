"""The numbers of a mirror with hysteretic stiffness, the mirror they make, and where a fit of them begins.

    x' = A x + B u(t - delay) + E z      q = F x + G u(t - delay)      z = P[q]      y = C x + D u(t - delay) + K z

A is block-diagonal, a block [[s, -w], [w, s]] for each pair of poles and then the real poles; P is a bank of
Prandtl-Ishlinskii operators with fixed thresholds, each with a polynomial beside its plays.
"""

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from microrad.core.arrays import Complexes, Floats
from microrad.lab.identify.linear.modal import ModalModel
from microrad.lab.identify.linear.order import fit_order
from microrad.lab.identify.linear.response import FrequencyResponse
from microrad.mirror.hysteresis import PrandtlIshlinskii
from microrad.mirror.model import Mirror

_DELAY_ORDER = 20  # most states of the models that a delay is found with

FIELDS = ("decay", "frequency", "B", "E", "F", "G", "weights", "polynomial", "C", "D", "K")


class LinearStart(NamedTuple):
    """A linear model behind a delay, for a drive that is straight over each step."""

    model: ModalModel
    delay_s: float


@dataclass(frozen=True, eq=False)
class Numbers:
    """The numbers of a model.

    ``decay`` holds s of all pairs and then of the real poles, ``frequency`` w of the pairs (rad/s); ``weights`` and
    ``thresholds`` have the shape (operators, plays), ``polynomial`` (operators, 3) and ``reach`` (operators,), see
    `hysteresis.PrandtlIshlinskii`. The thresholds and the reach are fixed.
    """

    decay: Floats
    frequency: Floats
    B: Floats
    E: Floats
    F: Floats
    G: Floats
    weights: Floats
    polynomial: Floats
    C: Floats
    D: Floats
    K: Floats
    thresholds: Floats
    reach: Floats
    delay_s: float

    @property
    def poles(self) -> Complexes:
        """Pole of each pair with positive frequency, then the real poles (rad/s)."""
        pole = self.decay.astype(complex)
        pole[: self.frequency.size] += 1j * self.frequency
        return pole

    @property
    def poles_at_rest(self) -> Complexes:
        """Poles of small motions, all plays with a threshold stuck: as `poles`, in rising frequency of the pairs."""
        own = self.mirror("")
        gains = np.sum(self.weights * (self.thresholds == 0.0), axis=1)
        found = np.linalg.eigvals(own.A + (own.E * gains) @ own.F)
        pairs, real = found[found.imag > 0.0], found[found.imag == 0.0]
        return np.concatenate([pairs[np.argsort(pairs.imag)], real[np.argsort(real.real)]])

    @property
    def rows(self) -> list[int]:
        """First state of each mode."""
        pairs = self.frequency.size
        return [2 * i for i in range(pairs)] + [pairs + i for i in range(pairs, self.decay.size)]

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
        for name in ("weights", "polynomial"):
            found += [f"hysteresis.{i + 1}.{name}.{j + 1}" for i, j in np.ndindex(getattr(self, name).shape)]
        for name in ("C", "D", "K"):
            found += [f"matrices.{name}.{i + 1}.{j + 1}" for i, j in np.ndindex(getattr(self, name).shape)]
        return (*found, "recording.delay")

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
            PrandtlIshlinskii(
                tuple(self.thresholds[e].tolist()),
                tuple(self.weights[e].tolist()),
                polynomial_rad=(float(c[0]), float(c[1]), float(c[2])),
                reach_v=float(self.reach[e]),
            )
            for e, c in enumerate(self.polynomial)
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
        polynomial=numbers.polynomial * drive,
        thresholds=numbers.thresholds * drive,
        reach=numbers.reach * drive,
        C=numbers.C * output,
        D=numbers.D * output / drive,
        K=numbers.K * output / drive,
    )


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
    return LinearStart(model, delay_s)


def best_delay(response: FrequencyResponse, order: int, sub_steps: int) -> float:
    """The delay (s) on a grid of a quarter of a sample up to two samples behind which a linear model fits best.

    Args:
        response: The measured response.
        order: Number of states of the model behind the delay, which is found with 20 at most.
        sub_steps: Steps of the plant in each sample.
    """
    tried = np.arange(0.0, 2.01, 0.25) / response.rate_hz
    order = min(order, _DELAY_ORDER)
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
