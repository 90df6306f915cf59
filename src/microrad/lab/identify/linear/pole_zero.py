"""The linear part of one axis as poles, zeros, gain and a pure delay, in a measured frequency response.

A delay of the recording chain, creep, and the loss of a small hysteresis loop leave their marks in a response, and a
scan of orders takes poles and zeros for them. Here the delay is a number of its own, creep is a sum of lags from 10 ms
on, and the loss an imaginary part of the gain, the same at all frequencies (a hysteresis that knows no rate does that
to a sine of constant amplitude). Poles and zeros that the response does not need are taken away one by one: each has a
price (the Bayesian information criterion; G. Schwarz, Annals of Statistics 6 (1978) 461). What no model tried could
explain thereabouts, as the distortion of a hysteresis, counts as noise.

Gain, loss and lags are linear and solved exactly at each point (variable projection: G. Golub and V. Pereyra, Inverse
Problems 19 (2003) R1).
"""

import math
from collections.abc import Iterable, Sequence
from copy import copy
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from microrad.core.arrays import Complexes, Floats
from microrad.lab.identify.linear.modal import Hold, ModalModel, hold_basis, order_modes
from microrad.lab.identify.linear.response import FrequencyResponse
from microrad.lab.identify.statistics import central_differences

_MOST_LINES = 500
_SURE = 1e-5  # of a response: the least standard error that counts, for records without noise
_DAMPING = (1e-4, 0.9999)
UNSEEN = 1e12
"""Price of a pole that a record cannot show, more than any distance."""
_FLAT = 0.5  # damping from which a slow pair is nothing but creep
_END = 0.5  # of the band: a zero beyond may stand for a pole
_GAIN = 1e-3  # of the criterion, at least, so that no change is made twice
_FAR = (
    5.0  # times the highest excited frequency: what lies beyond is told from a delay by less than 2 % of the response
)
_APART = 1e-3  # of its size: two poles nearer than this at the start are moved apart
_TURN = 0.5  # longest delay, in periods of the highest excited frequency
_SCREENED, _EVALUATIONS = 4, 40
_SETTLED = 4  # changes that are fitted to their end: with two, where a search ends chose the next change
_NEIGHBOURS, _ABOUT = 1.1, 2.0  # factors in frequency over which noise and scatter are averaged
_FEWEST = 10  # lines to either side over which they are averaged at least


class Root(NamedTuple):
    """A root: natural frequency in Hz and damping ratio of a pair; of a real one damping is None.

    The frequency of a real zero has the sign of its decay and may pass through infinity, so its inverse is searched.
    """

    frequency_hz: float
    damping: float | None

    @property
    def size_hz(self) -> float:
        """Natural frequency without its sign."""
        return abs(self.frequency_hz)

    @property
    def delay_s(self) -> float:
        """Delay of a pole far below its frequency; a zero makes as much lead."""
        return (1.0 if self.damping is None else 2.0 * self.damping) / (2 * math.pi * self.frequency_hz)

    @property
    def states(self) -> int:
        """Number of roots."""
        return 1 if self.damping is None else 2

    @property
    def values(self) -> list[complex]:
        """The roots in rad/s."""
        w = 2 * math.pi * self.frequency_hz
        if self.damping is None:
            return [complex(-w)]
        root = w * complex(-self.damping, math.sqrt(1.0 - self.damping**2))
        return [root, root.conjugate()]


@dataclass(frozen=True, slots=True)
class PoleZero:
    """Poles, zeros and the delay (s) behind them; the gain belongs to a fit."""

    poles: tuple[Root, ...]
    zeros: tuple[Root, ...]
    delay_s: float

    @property
    def count(self) -> int:
        """Numbers in it."""
        return _states(self.poles) + _states(self.zeros) + 1


def _states(roots: Sequence[Root]) -> int:
    return sum(root.states for root in roots)


def root_values(roots: Sequence[Root]) -> Complexes:
    """Roots in rad/s, conjugates included, shape (roots,)."""
    return np.array([value for root in roots for value in root.values], dtype=complex)


class PoleZeroProblem:
    """Distance of poles, zeros, delay and creep to a response of one drive and one output, in standard errors.

    The weight of a lag of creep counts as well, in parts of the median response: lags that the band hardly tells apart
    would else cancel one another at thousands of times the gain.
    """

    def __init__(self, response: FrequencyResponse, lags_s: Sequence[float], length_s: float) -> None:
        """`lags_s` are the time constants of the creep fitted along, `length_s` is that of a record or period."""
        self.length_s = length_s
        self.hold: Hold = response.hold
        self.rate_hz, self.highest_hz = response.rate_hz, response.excited_hz[1]
        self.lowest_hz = response.excited_hz[0]
        self.freq_hz, self.measured, error, self.power = merged(response, _MOST_LINES)
        # Each line tells its own error from a few numbers; neighbours have about the same noise.
        noise = _near(self.freq_hz, error**2 * self.power, _NEIGHBOURS)
        error = np.sqrt(noise / self.power)
        self.root_weight = math.sqrt(2.0) / np.maximum(error, _SURE * np.abs(self.measured))
        self.lags_s = tuple(lags_s)
        poles = np.array([complex(-1.0 / tau) for tau in self.lags_s])
        self._lags = -poles * hold_basis(poles, self.freq_hz, self.hold, self.rate_hz, rates=False)[0]
        self._weak = np.eye(len(self.lags_s), 2 + len(self.lags_s), 2) / float(np.median(np.abs(self.measured)))
        self._target = self._measured()

    def worth_less(self, best: PoleZero) -> "PoleZeroProblem":
        """The same, each frequency worth less by what no model explains thereabouts: distortion counts as noise.

        Args:
            best: The model with the least distance.
        """
        squares = np.square(self.residual(best)[: self.values]).reshape(2, -1).sum(axis=0) / 2
        scatter = _near(self.freq_hz, squares, _ABOUT)
        other = copy(self)
        other.root_weight = self.root_weight / np.sqrt(np.maximum(scatter, 1.0))
        other._target = other._measured()
        return other

    def shows(self, pole: Root) -> bool:
        """Whether a record can show a pole: a pair rings out in it, and one without an oscillation is no creep.

        Args:
            pole: The pole or pair.
        """
        if pole.damping is None:
            return True
        rings_s = 1.0 / (2 * math.pi * pole.frequency_hz * pole.damping)
        return rings_s < self.length_s / math.pi and (pole.damping < _FLAT or pole.frequency_hz > self.slowest_hz)

    @property
    def slowest_hz(self) -> float:
        """Frequency of the slowest real pole: what is slower is creep, or nothing that the response shows."""
        return max([self.lowest_hz, *(1 / (2 * math.pi * tau) for tau in self.lags_s)])

    @property
    def values(self) -> int:
        """Number of real values in the response."""
        return 2 * self.freq_hz.size

    def _measured(self) -> Floats:
        """What the columns are to make: the weighted response, and no creep."""
        return np.append(self._rows(self.measured[:, None]), np.zeros(len(self.lags_s)))

    def _rows(self, columns: Complexes) -> Floats:
        weighted = columns * self.root_weight[:, None]
        return np.concatenate([weighted.real, weighted.imag])

    def columns(self, at: PoleZero) -> Floats:
        """The weighted response of unit gain, the same turned by 90 degrees, and of each lag, then the lags' weights.

        The shape is (values + lags, 2 + lags).
        """
        shape = sampled(at, self.freq_hz, self.hold, self.rate_hz)
        return np.vstack([self._rows(np.column_stack([shape, 1j * shape, self._lags])), self._weak])

    def residual(self, at: PoleZero) -> Floats:
        """What is left of the response where gain, loss and lags are the best; all of it where two poles coincide."""
        columns = self.columns(at)
        if not np.isfinite(columns).all():
            return self._target
        basis = np.linalg.qr(columns)[0]
        return np.asarray(self._target - basis @ (basis.T @ self._target))

    def linear(self, at: PoleZero) -> Floats:
        """Gain at rest, its imaginary part and weights of the lags, in units of output per unit of drive."""
        columns = self.columns(at)
        size = np.linalg.norm(columns, axis=0) + 1e-300
        return np.asarray(np.linalg.lstsq(columns / size, self._target)[0] / size)

    def output_error_rms(self, at: PoleZero) -> float:
        """Rms output error that the distance stands for: squared, by the power of the drive, over all frequencies.

        Args:
            at: Poles, zeros and delay.
        """
        left = self.residual(at)[: self.values]
        half = left.size // 2
        squared = (left[:half] ** 2 + left[half:] ** 2) / self.root_weight**2
        return math.sqrt(float(np.sum(squared * self.power)))

    # -------------------------------------------------------------------------------------------------- the numbers
    def pack(self, at: PoleZero) -> Floats:
        """The numbers as a search sees them, each of order one."""
        top = self.highest_hz
        found: list[float] = []
        for root in at.poles:
            found.append(math.log(root.frequency_hz / top))
            found += [] if root.damping is None else [root.damping]
        for root in at.zeros:
            found.append(top / root.frequency_hz if root.damping is None else math.log(root.frequency_hz / top))
            found += [] if root.damping is None else [root.damping]
        return np.array([*found, 2 * math.pi * top * at.delay_s])

    def unpack(self, numbers: Floats, like: PoleZero) -> PoleZero:
        """The poles and zeros of such numbers.

        Args:
            numbers: As `pack` orders them.
            like: Poles and zeros of the same kinds.
        """
        top, at = self.highest_hz, iter(numbers.tolist())
        poles = [Root(top * math.exp(next(at)), None if r.damping is None else next(at)) for r in like.poles]
        zeros = []
        for root in like.zeros:
            first = next(at)
            if root.damping is None:
                zeros.append(Root(top / math.copysign(max(abs(first), 1e-9), first), None))
            else:
                zeros.append(Root(top * math.exp(first), next(at)))
        return PoleZero(tuple(poles), tuple(zeros), next(at) / (2 * math.pi * top))

    def bounds(self, like: PoleZero) -> tuple[Floats, Floats]:
        """Lowest and highest of each number."""
        far = math.log(_FAR)
        near = math.log(self.lowest_hz / self.highest_hz)
        real = math.log(self.slowest_hz / self.highest_hz)
        low: list[float] = []
        high: list[float] = []
        for root in like.poles:
            low += [real] if root.damping is None else [near, _DAMPING[0]]
            high += [far] if root.damping is None else [far, _DAMPING[1]]
        for root in like.zeros:
            slow = self.highest_hz / self.lowest_hz
            low += [-slow] if root.damping is None else [near, -_DAMPING[1]]
            high += [slow] if root.damping is None else [far, _DAMPING[1]]
        step = 2 * math.pi * self.highest_hz / self.rate_hz
        return np.array([*low, -step]), np.array([*high, 2 * math.pi * _TURN])

    def started(self, poles: Iterable[complex], zeros: Iterable[complex], delay_s: float) -> PoleZero:
        """Poles and zeros (rad/s, conjugates included) as the search takes them.

        What lies far beyond the excited band is left out, and so is a real pole that only stands in for creep, with the
        zero beside it. Poles that coincide are moved apart.

        Args:
            poles: The poles, all stable.
            zeros: The zeros.
            delay_s: The delay to begin with, in s.
        """
        far = 2 * math.pi * _FAR * self.highest_hz
        found = sorted((_root(p) for p in poles if p.imag >= 0), key=lambda root: root.frequency_hz)
        above = sorted((_root(z) for z in zeros if z.imag >= 0 and abs(z) < far), key=lambda root: root.size_hz)
        kept: list[Root] = []
        for root in found:
            if root.damping is None and root.frequency_hz < self.slowest_hz:
                beside = [z for z in above if z.damping is None and z.size_hz < 2 * self.slowest_hz]
                above = [z for z in above if z not in beside[:1]]
            elif root.frequency_hz < _FAR * self.highest_hz:
                again = bool(kept) and root.frequency_hz < (1 + _APART) * kept[-1].frequency_hz
                kept.append(root._replace(frequency_hz=(1 + _APART) * kept[-1].frequency_hz) if again else root)
        kept = kept or [Root(max(self.slowest_hz, min(found[-1].frequency_hz, self.highest_hz)), None)]
        while _states(above) >= _states(kept):
            above.pop()
        return PoleZero(tuple(kept), tuple(above), delay_s)

    # --------------------------------------------------------------------------------------------------- the search
    def fitted(self, start: PoleZero, evaluations: int = _EVALUATIONS) -> "Fitted":
        """The least squares about a start.

        Args:
            start: Poles, zeros and delay.
            evaluations: Largest number of steps.
        """
        from scipy.optimize import least_squares

        low, high = self.bounds(start)
        margin = 1e-6 * (high - low)
        found = least_squares(
            lambda numbers: self.residual(self.unpack(numbers, start)),
            np.clip(self.pack(start), low + margin, high - margin),
            bounds=(low, high),
            x_scale="jac",
            ftol=1e-7,
            xtol=1e-8,
            max_nfev=evaluations,
        )
        return Fitted(self, self.unpack(found.x, start), 2.0 * float(found.cost))


@dataclass(frozen=True, eq=False)
class Fitted:
    """Poles and zeros where the distance to a response is least."""

    problem: PoleZeroProblem
    at: PoleZero
    chi_square: float

    @property
    def parameters(self) -> int:
        """Numbers fitted, gain and lags counted."""
        return self.at.count + 2 + len(self.problem.lags_s)

    @property
    def freedom(self) -> int:
        """Values less numbers."""
        return max(self.problem.values - self.parameters, 1)

    @cached_property
    def criterion(self) -> float:
        """What is left and the price of the numbers."""
        none = sum(not self.problem.shows(pole) for pole in self.at.poles)
        return self.chi_square + self.parameters * math.log(self.problem.values) + UNSEEN * none

    @property
    def output_error_rms(self) -> float:
        """Rms output error that the distance stands for, in units of the output."""
        return self.problem.output_error_rms(self.at)

    @cached_property
    def gains(self) -> Floats:
        """Gain at rest and weights of the lags."""
        return self.problem.linear(self.at)

    def modes(self, *, creep: bool = False) -> ModalModel:
        """The model as modes, behind its delay.

        Args:
            creep: Whether the lags belong to it.
        """
        return modes_of(self.at, float(self.gains[0]), self.gains[2:] if creep else (), self.problem.lags_s)

    def covariance(self) -> Floats:
        """Covariance of the numbers of `pack`, of the gain (relative) and of the lags, for a scatter of 1."""
        problem, numbers = self.problem, self.problem.pack(self.at)
        gains = self.gains
        moved = central_differences(
            lambda v: problem.columns(problem.unpack(v, self.at)) @ gains, numbers, np.full(numbers.size, 1e-6)
        )
        own = problem.columns(self.at) * np.array([gains[0], gains[0], *np.ones(gains.size - 2)])
        jacobian = np.hstack([moved, own])
        size = np.linalg.norm(jacobian, axis=0) + 1e-300
        values, vectors = np.linalg.eigh((jacobian / size).T @ (jacobian / size))
        inverse = (vectors / np.maximum(values, 1e-14)) @ vectors.T
        return np.asarray(inverse / np.outer(size, size))


# -------------------------------------------------------------------------------------------------------- the response
def sampled(at: PoleZero, freq_hz: Floats, hold: Hold, rate_hz: float) -> Complexes:
    """Response of unit gain at rest, behind the hold and the delay, shape (frequencies,).

    Args:
        at: Poles, zeros and delay.
        freq_hz: Frequencies, in Hz.
        hold: What the drive does between samples.
        rate_hz: Sample rate, in Hz.
    """
    poles, residues = root_values(at.poles), _residues(at)
    basis = hold_basis(poles, freq_hz, hold, rate_hz, rates=False)[0]
    return np.asarray((basis @ residues) * np.exp(-2j * np.pi * freq_hz * at.delay_s))


def _residues(at: PoleZero) -> Complexes:
    """Residue at each pole, for a gain of 1 at rest."""
    poles, zeros = root_values(at.poles), root_values(at.zeros)
    over = 1.0 - poles[:, None] / poles[None, :]
    np.fill_diagonal(over, 1.0)
    above = np.prod(1.0 - poles[:, None] / zeros[None, :], axis=1) if zeros.size else 1.0
    return np.asarray(-poles * above / np.prod(over, axis=1))


def modes_of(at: PoleZero, gain: float, weights: Iterable[float], lags_s: Sequence[float]) -> ModalModel:
    """The modes of poles and zeros with a gain at rest, and of lags beside them.

    Args:
        at: Poles, zeros and delay.
        gain: Gain at rest, in units of output per unit of drive.
        weights: Gain of each lag; none to leave them out.
        lags_s: Time constants of the lags, in s.
    """
    poles, residues = root_values(at.poles), gain * _residues(at)
    kept = poles.imag >= 0
    slow = [(-1.0 / tau, weight / tau) for weight, tau in zip(weights, lags_s, strict=False)]
    every = np.concatenate([poles[kept], [p for p, _ in slow]])
    sizes = np.concatenate([residues[kept], [r for _, r in slow]])
    return replace(
        order_modes(every, np.ones((every.size, 1), dtype=complex), sizes[None, :], np.zeros((1, 1))),
        delay_s=at.delay_s,
    )


def _near(freq_hz: Floats, values: Floats, factor: float) -> Floats:
    """Mean of values over the neighbouring lines, those within a factor in frequency and some to either side."""
    number = np.arange(freq_hz.size)
    low = np.minimum(np.searchsorted(freq_hz, freq_hz / factor), np.maximum(number - _FEWEST, 0))
    high = np.searchsorted(freq_hz, freq_hz * factor, side="right")
    high = np.maximum(high, np.minimum(number + _FEWEST + 1, freq_hz.size))
    added = np.append(0.0, np.cumsum(values))
    return np.asarray((added[high] - added[low]) / (high - low))


def merged(response: FrequencyResponse, most: int) -> tuple[Floats, Complexes, Floats, Floats]:
    """Frequencies, response, standard error and power of the drive, neighbouring lines merged by what they are worth.

    Args:
        response: The response of one drive and one output.
        most: Largest number of lines.
    """
    freq, values, error = response.freq_hz, response.response[:, 0, 0], response.standard_error[:, 0, 0]
    power = np.asarray(response.drive_power[:, 0, 0].real)
    if freq.size <= most:
        return freq, values, error, power
    marks = np.unique(np.searchsorted(freq, np.geomspace(freq[0], freq[-1], most + 1)[:-1]))
    worth = 1.0 / np.maximum(error, _SURE * np.abs(values)) ** 2
    total = np.add.reduceat(worth, marks)
    added = np.asarray(np.add.reduceat(worth * values, marks), dtype=np.complex128)
    return (
        np.add.reduceat(worth * freq, marks) / total,
        added / total,
        1.0 / np.sqrt(total),
        np.asarray(np.add.reduceat(power, marks)),
    )


# ------------------------------------------------------------------------------------------------------------ pruning
def _root(value: complex) -> Root:
    size = abs(value) / (2 * math.pi)
    if abs(value.imag) <= 1e-9 * abs(value):
        return Root(math.copysign(size, -value.real), None)
    return Root(size, -value.real / abs(value))


def pruned(fit: Fitted) -> Fitted:
    """The fit without the poles and zeros that the response does not need.

    What goes is a zero, a pole or a pair, alone or with the zeros nearest to it, or the oscillation of a pair; a zero
    at the end of the band may become a pole there, for both turn the phase as a delay does. As long as a change,
    everything else fitted anew, lowers the criterion, the one that lowers it most is made.

    Args:
        fit: The fit to begin with.
    """
    while True:
        tried = [fit.problem.fitted(other, _SCREENED) for other in _others(fit)]
        tried.sort(key=lambda found: found.criterion)
        settled = [fit.problem.fitted(found.at) for found in tried[:_SETTLED]]
        best = min(settled, key=lambda found: found.criterion, default=None)
        if best is None or best.criterion > fit.criterion - _GAIN:
            return fit
        fit = best


def _others(fit: Fitted) -> list[PoleZero]:
    """Poles and zeros with something less, or with a pole for a zero."""
    at = fit.at
    found = [_less(at, (), [k]) for k in range(len(at.zeros))]
    for k, pole in enumerate(at.poles):
        order = sorted(range(len(at.zeros)), key=lambda j: abs(math.log(at.zeros[j].size_hz / pole.frequency_hz)))
        single = [j for j in order if at.zeros[j].damping is None]
        double = [j for j in order if at.zeros[j].damping is not None]
        takes: list[list[int]] = [[], single[:1]] if single else [[]]
        takes += [double[:1]] if double else []
        if pole.damping is not None:
            takes += [single[:2]] if len(single) > 1 else []
            flat = replace(at, poles=(*_without(at.poles, [k]), Root(pole.frequency_hz, None)))
            found += [flat, *([_less(flat, (), single[:1])] if single else [])]
        found += [_less(at, [k], taken) for taken in takes]
    top = fit.problem.highest_hz
    for k, zero in enumerate(at.zeros):
        if zero.size_hz > _END * top:
            less = _less(at, (), [k])
            found.append(
                replace(less, poles=(*less.poles, Root(top, None)), delay_s=less.delay_s - 1.0 / (2 * math.pi * top))
            )
    return [one for one in found if _states(one.poles) > _states(one.zeros)]


def _less(at: PoleZero, poles: Sequence[int], zeros: Sequence[int]) -> PoleZero:
    """Without some poles and zeros; the delay takes the turn of phase that they made at low frequencies."""
    turn = sum(at.poles[k].delay_s for k in poles) - sum(at.zeros[k].delay_s for k in zeros)
    return PoleZero(_without(at.poles, poles), _without(at.zeros, zeros), at.delay_s + turn)


def _without(roots: tuple[Root, ...], which: Sequence[int]) -> tuple[Root, ...]:
    return tuple(root for k, root in enumerate(roots) if k not in which)
