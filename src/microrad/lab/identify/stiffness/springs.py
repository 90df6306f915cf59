"""Hysteretic springs that cannot gain energy: the free numbers of a mirror with them, and where a fit begins.

Each pair of poles m that carries springs is x1' = s x1 - w x2 + b u + f, x2' = w x1 + s x2. A spring is moved by
q = sum over these pairs of phi_m x2 + g u, and pushes each of them by f = phi_m z, with the same phi. z is the sum over
its plays of w_j play_j(q), and a polynomial of q that ends at its reach. Weights of plays with a threshold are at least
0; that of a play without one takes the mean gain of the others off and has any sign. Operators that the drive alone
moves (q = u) act on all modes as they like: what is fed forward takes no energy from anywhere. So do springs on the
output, on real poles, and on pairs above half of the sample rate, which stand for what is left of the delay.

No drive makes such a mirror run away. Without drive x2''/w + 2|s|/w x2' + k x2 = sum of phi z, with k = (s^2 + w^2)/w:
masses 1/w on springs k. A play is p = q - d with its stop d in [-r, r], and d (q' - d') >= 0, so that p q' is at most
(q^2 - d^2)'/2; equal to it without a threshold, whatever the sign of its weight. With Phi(q) the integral of the
polynomial,

    V = sum over the pairs (x2'^2/w + k x2^2)/2 - sum over springs (Phi(q) + sum over plays w_j (q^2 - d_j^2)/2)

never grows. Phi grows no faster than |q|, so that V rises without bound with the states of these pairs where the plays
alone take less than all of the stiffness: where the largest eigenvalue of k^-1/2 phi W phi' k^-1/2, W the sums of
weights, is below 1 (`Springs.softening`; a fit keeps it below 0.9). Then A + E W F is stable as well; a play differs
from q by at most its threshold and the polynomial is bounded, so that a bounded drive moves a bounded state, however
large it is. What springs push and does not push back is a stable system behind them. (The loop is a positive feedback
of negative-imaginary systems: A. Lanzon and I. Petersen, IEEE Trans. Automatic Control 53 (2008) 1042.)
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from microrad.core import kernels
from microrad.core.arrays import Floats
from microrad.lab.identify.records import IdentificationError
from microrad.lab.identify.stiffness import tangents
from microrad.lab.identify.stiffness.model import FIELDS, LinearStart, Numbers
from microrad.lab.identify.stiffness.tangents import Steady

MOST_SOFTENING = 0.9
_LIGHT, _SOFTENING = 1e-3, 0.02  # weight of a play and most softening where a fit begins
_SEEN = 1e-6  # part of an output that sees the displacement of a mode: with less it sees the velocity alone
_SLOWEST = 0.1  # frequency of a mode, in that where a fit begins
_LEAST_DAMPING = 1e-4  # decay of a mode, in the size of its pole where a fit begins
_REACH = 1.3  # of a polynomial, in the largest drive of its operator where a fit begins


@dataclass(frozen=True, eq=False)
class Springs:
    """The free numbers of a mirror whose first ``count`` operators are springs, and how they make all the others.

    The numbers of the mirror are ``rest`` + ``matrix`` @ free. ``kinds`` names what each free number is; it stays
    between ``least`` and ``most``: weights at 0 or above, decays and frequencies away from 0.
    """

    mirror: Numbers
    count: int
    matrix: Floats
    rest: Floats
    kinds: np.ndarray
    least: Floats
    most: Floats

    def numbers(self, free: Floats) -> Numbers:
        """The mirror of free numbers."""
        return self.mirror.at(self.rest + self.matrix @ free)

    @property
    def redundant(self) -> int:
        """Numbers that change nothing: scale of each operator on the drive, and of each mode that carries no spring."""
        pairs = self.mirror.frequency.size
        carried = int(np.count_nonzero(self.mirror.F[: self.count, 1 : 2 * pairs : 2].any(axis=0)))
        drives = self.mirror.weights.shape[0] - self.count
        return int(drives + (self.mirror.decay.size - pairs) + 2 * (pairs - carried))

    def softening(self, numbers: Numbers) -> float:
        """Largest share of stiffness that the plays take away where all of them slide; below 1 no drive runs away."""
        pairs = numbers.frequency.size
        stiffness = (numbers.decay[:pairs] ** 2 + numbers.frequency**2) / numbers.frequency
        phi = numbers.F[: self.count, 1 : 2 * pairs : 2].T / np.sqrt(stiffness)[:, None]
        return float(np.linalg.eigvalsh((phi * numbers.weights.sum(axis=1)[: self.count]) @ phi.T).max())

    def within(self, free: Floats) -> Floats:
        """The nearest free numbers within their limits."""
        return np.asarray(np.clip(free, self.least, self.most))

    def inside(self, free: Floats) -> np.ndarray:
        """Which numbers do not lie at a limit."""
        return np.asarray((free > self.least) & (free < self.most))

    def loose(self, free: Floats, slope: Floats) -> np.ndarray:
        """Which numbers may move: those that do not lie at a limit beyond which the search would take them.

        Args:
            free: The free numbers.
            slope: Derivative of the cost by each of them.
        """
        return np.asarray(((free > self.least) | (slope < 0.0)) & ((free < self.most) | (slope > 0.0)))


def begin(
    start: LinearStart,
    largest: Sequence[Steady],
    middle: Sequence[Steady],
    count: int | None,
    thresholds: Sequence[float],
    *,
    fixed_delay: bool,
) -> tuple[Springs, Floats]:
    """Springs of next to no weight in a linear model, and the free numbers with which a fit begins.

    The first springs act on the modes as the actuators do, further ones as the outputs see them, and then those again
    with some modes the other way. The scale of each is such that q reaches as far as the largest drive.

    Args:
        start: The linear model and its delay, in the units of the records.
        largest: The records of the largest amplitude.
        middle: The records of the linear model's amplitude.
        count: Number of springs; by default twice that of actuators and outputs, and of pairs at most.
        thresholds: Thresholds of the plays of each operator, as parts of the largest drive, above 0 and ascending.
        fixed_delay: Whether the delay stays as it is.

    Raises:
        IdentificationError: If no pair of poles lies below half of the sample rate.
    """
    model = start.model
    pairs = np.flatnonzero(model.poles_rad_s.imag != 0)
    order = np.concatenate([pairs, np.flatnonzero(model.poles_rad_s.imag == 0)])
    turn = np.exp(-0.5j * np.angle(np.sum(model.input_vectors[pairs] ** 2, axis=1)))  # forces lie along x1
    b, c = model.input_vectors[order].copy(), model.output_vectors[:, order].copy()
    b[: pairs.size] *= turn[:, None]
    c[:, : pairs.size] *= 2.0 / turn
    wide, states, (outputs, inputs) = 2 * pairs.size, pairs.size + order.size, model.direct.shape
    B, C = np.zeros((states, inputs)), np.zeros((outputs, states))
    B[0:wide:2], B[1:wide:2], B[wide:] = b[: pairs.size].real, b[: pairs.size].imag, b[pairs.size :].real
    C[:, 0:wide:2], C[:, 1:wide:2], C[:, wide:] = (
        c[:, : pairs.size].real,
        -c[:, : pairs.size].imag,
        c.real[:, pairs.size :],
    )
    carries = np.abs(model.poles_rad_s[pairs]) < np.pi * largest[0].rate_hz
    if not carries.any():
        raise IdentificationError(
            f"the linear model of order {model.order} has no pair of poles below {largest[0].rate_hz / 2:g} Hz for a "
            "spring to act on; fit a larger order."
        )
    count = min(2 * (inputs + outputs), 2 * int(carries.sum())) if count is None else count
    strain = c[:, : pairs.size].T
    seen = np.where(np.abs(strain.imag) > _SEEN * np.abs(strain), strain.imag, strain.real)
    phi = _shapes(b[: pairs.size].real, seen, count) * carries[:, None]
    operators, D = count + inputs, model.direct.copy()
    E, F = np.zeros((states, operators)), np.zeros((operators, states))
    E[:, count:] = B
    numbers = Numbers(
        decay=model.poles_rad_s[order].real.copy(),
        frequency=model.poles_rad_s[pairs].imag.copy(),
        B=B,
        E=E,
        F=F,
        G=np.vstack([np.zeros((count, inputs)), np.eye(inputs)]),
        weights=np.outer(_LIGHT * (1.0 + 0.1 * _alike(phi, inputs)), np.ones(1 + len(thresholds))),
        polynomial=np.zeros((operators, 3)),
        C=C,
        D=D,
        K=np.hstack([np.zeros((outputs, count)), D]),
        thresholds=np.zeros((operators, 1 + len(thresholds))),
        reach=np.ones(operators),
        delay_s=start.delay_s,
    )
    motions = _motions(numbers, largest, phi)
    farthest = max(float(np.abs(motion[:, count:]).max()) for motion in motions)
    moved = np.max([np.abs(motion[:, :count]).max(axis=0) for motion in motions], axis=0)
    phi = phi * np.where(moved > 0.0, farthest / np.where(moved > 0.0, moved, 1.0), 1.0)
    E[0:wide:2, :count], F[:count, 1:wide:2] = phi, phi.T
    numbers = replace(
        numbers,
        thresholds=np.zeros_like(numbers.thresholds) + farthest * np.array([0.0, *thresholds]),
        reach=np.where(np.arange(operators) < count, _REACH * farthest, np.inf),
    )
    springs, free = _free(numbers, (count, carries), fixed_delay, _gains(numbers, middle, phi))
    softening = springs.softening(springs.numbers(free))
    if softening > _SOFTENING:
        free = np.where(springs.kinds == "weights", free * _SOFTENING / softening, free)
    return springs, free


def _alike(phi: Floats, inputs: int) -> Floats:
    """How many springs before each act as it does, so that their weights may tell them apart; none on the drives."""
    unit = phi / np.maximum(np.linalg.norm(phi, axis=0), 1e-300)
    same = np.abs(unit.T @ unit) > 1.0 - 1e-9
    return np.concatenate([np.tril(same, -1).sum(axis=1), np.zeros(inputs)])


def _motions(numbers: Numbers, records: Sequence[Steady], phi: Floats) -> list[Floats]:
    """What moves each operator where the springs do not push back: q at each step of each record's steady state."""
    far = replace(numbers, E=np.zeros_like(numbers.E), K=np.zeros_like(numbers.K), F=np.zeros_like(numbers.F))
    plant, found = tangents.play_plant(far, records[0].step_s), []
    for record in records:
        drive = tangents.two_periods(record, numbers.delay_s)
        state = tangents.simulate_path(plant, drive).x[len(drive) // 2 :, 1 : 2 * numbers.frequency.size : 2]
        found.append(np.hstack([state @ phi, drive[len(drive) // 2 :]]))
    return found


def _gains(numbers: Numbers, middle: Sequence[Steady], phi: Floats) -> tuple[Floats, Floats]:
    """Gain of each play, and of each power, at the middle amplitude: shapes (operators, plays) and (operators, 3)."""
    plays, powers = np.zeros_like(numbers.weights), np.zeros_like(numbers.polynomial)
    size = np.zeros(len(plays))
    for motion in _motions(numbers, middle, phi):
        size += np.sum(motion**2, axis=0)
        powers += np.einsum("ke,kei->ei", motion, tangents.powers(motion, numbers.reach))
        for e, q in enumerate(motion.T):
            both, rest = np.concatenate([q, q]), np.zeros(plays.shape[1])
            plays[e] += q @ kernels.play_response(both, numbers.thresholds[e], rest)[len(q) :]
    moved = np.where(size > 0.0, size, np.inf)[:, None]  # an operator that nothing moves has no gain
    return plays / moved, powers / moved


def _shapes(forces: Floats, seen: Floats, count: int) -> Floats:
    """How each spring acts on the pairs: shape (pairs, springs). The n-th time round other pairs go the other way."""
    both = np.hstack([forces, seen])
    pair = np.arange(len(both))
    found = []
    for spring in range(count):
        again, column = divmod(spring, both.shape[1])
        sign = np.array([(-1.0) ** bin(k & again).count("1") for k in pair.tolist()])
        found.append(both[:, column] * sign)
    return np.asarray(np.stack(found, axis=1))


def _free(
    numbers: Numbers, springs: tuple[int, np.ndarray], fixed_delay: bool, gains: tuple[Floats, Floats]
) -> tuple[Springs, Floats]:
    """The free numbers.

    Args:
        numbers: The mirror with light springs.
        springs: How many there are, and which pairs they act on.
        fixed_delay: Whether the delay stays as it is.
        gains: Gain of each play and of each power at the middle amplitude.
    """
    place, at = {}, 0
    for name in FIELDS:
        values = getattr(numbers, name)
        place[name] = np.arange(at, at + values.size).reshape(values.shape)
        at += values.size
    count, carries = springs
    E, F, first = place["E"], place["F"], 2 * np.flatnonzero(carries)
    alone = np.ones(len(E), dtype=bool)
    alone[[*first, *(first + 1)]] = False
    pairs = zip(E[first, :count].ravel(), F[:count, first + 1].T.ravel(), strict=True)
    groups = [("phi", [[i, j] for i, j in pairs])]
    own = {
        "E": np.concatenate([E[:, count:].ravel(), E[alone, :count].ravel()]),
        "G": place["G"][:count],
        "weights": place["weights"][:, 1:],
        "polynomial": place["polynomial"][:count],
    }
    groups += [(name, [[i] for i in own.get(name, place[name]).ravel()]) for name in FIELDS if name != "F"]
    groups += [] if fixed_delay else [("delay", [[at]])]
    kinds = np.array([name for name, places in groups for _ in places])
    matrix = np.zeros((at + 1, kinds.size))
    for column, places in enumerate(each for _, group in groups for each in group):
        matrix[places, column] = 1.0
    vector = numbers.vector()
    free = matrix.T @ vector / matrix.sum(axis=0)
    rest = np.where(matrix.any(axis=1), 0.0, vector)
    linear = place["weights"][:, 0]  # a play without a threshold takes the gain of the others off
    rest[linear] = 0.0
    for name, gain in (("weights", gains[0]), ("polynomial", gains[1])):
        for e, j in np.ndindex(gain.shape):
            matrix[linear[e]] -= gain[e, j] * matrix[place[name][e, j]] * (place[name][e, j] != linear[e])
    least, most = np.full(free.size, -np.inf), np.full(free.size, np.inf)
    least[kinds == "weights"] = 0.0
    least[kinds == "frequency"] = _SLOWEST * numbers.frequency
    most[kinds == "decay"] = -_LEAST_DAMPING * np.abs(numbers.poles)
    return Springs(numbers, count, matrix, rest, kinds, least, most), np.clip(free, least, most)
