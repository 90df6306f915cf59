"""One model of the CubeSpec mirror whose hysteretic springs cannot gain energy, fitted by exact gradients.

    python benchmarks/cubespec_springs.py [held=5] [order=36] [springs=6] [iterations=120]

Each mode m is x1' = s x1 - w x2 + b u + f, x2' = w x1 + s x2. A spring e is moved by q = sum over the modes of
phi_m x2 + g u, and pushes each mode by f = phi_m z with z = sum w_j play_j(q), all w_j >= 0. Operators that the drive
alone moves (q = u) act on the modes as they like: what is fed forward takes no energy from anywhere.

No drive makes such a mirror run away. Without drive x2''/w + 2|s|/w x2' + k x2 = sum phi z, k = (s^2 + w^2)/w: masses
1/w on springs k. A play is p = q - d with its stop d in [-r, r], and d (q' - d') >= 0, so that p q' is at most
(q^2 - d^2)'/2. Hence

    V = sum over the modes (x2'^2/w + k x2^2)/2 - sum over springs and plays w_j (q^2 - d_j^2)/2

never grows. It is above zero where the springs give way by less than all of the stiffness, that is, where the largest
eigenvalue of W^1/2 (phi' k^-1 phi) W^1/2 is below 1 (W: the sums of weights). The search keeps it below 0.9. (The loop
is a positive feedback of negative-imaginary systems: A. Lanzon and I. Petersen, IEEE Trans. Automatic Control 53 (2008)
1042.)

The gradient of the error over all records comes from one pass back along each path (the adjoint of the kernel's own
step), the curvature from the forward derivatives of one record of each amplitude (`tangents.normal_equations`) and from
the gradients on the way (limited-memory BFGS). Errors in um as the authors of the recordings score (`cubespec`).
"""

import math
import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # as the command line does, before NumPy is loaded

import sys
import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

import numba
import numpy as np
from cubespec import AMPLITUDES_MV, all_but, realisations, score_um
from scipy.linalg import cho_factor, cho_solve

from microrad.lab.identify.linear.modal import hold_step
from microrad.lab.identify.linear.response import response_from_periods
from microrad.lab.identify.stiffness import tangents
from microrad.lab.identify.stiffness.fit import THRESHOLDS
from microrad.lab.identify.stiffness.model import FIELDS, LinearStart, Numbers, best_delay, linear_start, scaled
from microrad.lab.identify.stiffness.tangents import Steady
from microrad.lab.recording import Recording
from microrad.mirror import coupled

CHANNELS = ("drive", "output")
STEPS, DELAY_ORDER, MOST_GIVEN = 2, 20, 0.9
MEMORY, REFRESH, TRIALS = 30, 10, 4


def steady(record: Recording) -> Steady:
    """Mean of the record's periods."""
    drive, output = (
        getattr(record, c)
        .reshape(-1, record.period_samples or record.samples, getattr(record, c).shape[1])
        .mean(axis=0)
        for c in CHANNELS
    )
    return Steady(record.path, drive, output - output.mean(axis=0), record.rate_hz, STEPS)


# ------------------------------------------------------------------------------------------------------- the gradient
@numba.njit(nogil=True, cache=True)
def backward(plant, path, error, state, predicted, drive, bank):
    """Derivative of half the squared error by what enters each step, from the last step to the first.

    Args:
        plant: The `PlayPlant`.
        path: Its `Path`.
        error: Error of the output at each step, shape (steps, outputs).
        state, predicted, drive, bank: Derivatives by the state, the predicted state, q and z; written.
    """
    states, operators = state.shape[1], drive.shape[1]
    of_play, of_z, of_state = np.zeros(plant.play_threshold.size), np.zeros(operators), np.zeros(states)
    for k in range(error.shape[0] - 1, -1, -1):
        for i in range(states):
            state[k, i] = of_state[i]
            for o in range(error.shape[1]):
                state[k, i] += plant.C[o, i] * error[k, o]
            predicted[k, i] = state[k, i]
        for e in range(operators):
            back = 0.0
            for i in range(states):
                back += plant.E1[i, e] * state[k, i]
            total = of_z[e] + back
            for o in range(error.shape[1]):
                total += plant.K[o, e] * error[k, o]
            bank[k, e], of_z[e], drive[k, e] = total, -back, 0.0
            for j in range(plant.play_start[e], plant.play_start[e + 1]):
                of_play[j] += plant.play_weight[j] * total
                if j < plant.play_start[e] + path.moved[k, e]:
                    drive[k, e] += of_play[j]
                    of_play[j] = 0.0
            for i in range(states):
                predicted[k, i] += plant.F[e, i] * drive[k, e]
        for e in range(operators):
            for i in range(states):
                of_z[e] += plant.E_held[i, e] * predicted[k, i]
        for i in range(states):
            of_state[i] = plant.diagonal[i] * predicted[k, i] + plant.coupling[i ^ 1] * predicted[k, i ^ 1]


def gradient(numbers: Numbers, record: Steady) -> np.ndarray:
    """Derivative of the squared error of a record in its steady state by each of the numbers."""
    plant = tangents.play_plant(numbers, record.step_s)
    drive = tangents.two_periods(record, numbers.delay_s)
    path = tangents.simulate_path(plant, drive)
    half, first = len(drive) // 2, 2 * np.arange(numbers.decay.size)
    error = np.zeros_like(path.output)
    left = path.output[half :: record.sub_steps] - record.output
    error[half :: record.sub_steps] = left - left.mean(axis=0)
    by_state, by_predicted, by_q, by_z = (np.empty_like(v) for v in (path.x, path.x, path.z, path.z))
    backward(plant, path, error, by_state, by_predicted, by_q, by_z)

    def before(values: np.ndarray) -> np.ndarray:
        return np.concatenate([np.zeros((1, values.shape[1])), values[:-1]])

    def modal(values: np.ndarray) -> np.ndarray:
        return values[..., first] + 1j * values[..., first + 1]

    def real(values: np.ndarray) -> np.ndarray:
        return np.stack([values.real, values.imag], axis=1).reshape(-1, values.shape[1])

    step = hold_step(numbers.poles, "first-order", 1.0 / record.step_s)
    begin, end, begin_rate, end_rate = (v[:, None] for v in (step.begin, step.end, step.begin_rate, step.end_rate))
    of_predicted, of_state = modal(by_predicted).conj().T, modal(by_state).conj().T
    u0, u1, z0 = of_predicted @ before(drive), of_predicted @ drive, of_predicted @ before(path.z)
    z1 = of_state @ (path.z - before(path.z))
    pole = step.keep_rate * np.einsum("mk,km->m", of_predicted, modal(before(path.state)))
    pole += np.sum(modal(numbers.B.T).T * (begin_rate * u0 + end_rate * u1), axis=1)
    pole += np.sum(modal(numbers.E.T).T * ((begin_rate + end_rate) * z0 + end_rate * z1), axis=1)
    by_drive = by_predicted @ plant.B1 + by_q @ plant.G + error @ plant.D
    by_drive[:-1] += by_predicted[1:] @ plant.B0
    turn = -2j * np.pi * np.fft.rfftfreq(half, record.step_s)[:, None]
    later = np.fft.irfft(turn * np.fft.rfft(drive[:half], axis=0), half, axis=0)
    found = {
        "decay": pole.real,
        "frequency": -pole.imag,
        "B": real((begin * u0 + end * u1).conj()),
        "E": real(((begin + end) * z0 + end * z1).conj()),
        "F": by_q.T @ path.x,
        "G": by_q.T @ drive,
        "weights": np.einsum("ke,kej->ej", by_z, path.play.reshape(len(drive), *numbers.weights.shape)),
        "C": error.T @ path.state,
        "D": error.T @ drive,
        "K": error.T @ path.z,
    }
    delay = float(np.sum((by_drive[:half] + by_drive[half:]) * later))
    return 2.0 * np.concatenate([*(found[f].ravel() for f in FIELDS), [delay]])


# -------------------------------------------------------------------------------------------------------- the springs
@dataclass(frozen=True, eq=False)
class Springs:
    """The free numbers: how they make those of the mirror (`rest` + `matrix` @ numbers), and which are weights.

    A weight is the square of its number.
    """

    mirror: Numbers
    count: int
    matrix: np.ndarray
    rest: np.ndarray
    kinds: np.ndarray

    def numbers(self, free: np.ndarray) -> Numbers:
        return self.mirror.at(self.rest + self.matrix @ np.where(self.kinds == "weights", free**2, free))

    def slopes(self, free: np.ndarray) -> np.ndarray:
        return self.matrix * np.where(self.kinds == "weights", 2.0 * free, 1.0)

    def given(self, numbers: Numbers) -> float:
        """Share of the stiffness by which the springs give way where all plays slide; unstable above 1."""
        phi, root = numbers.E[0::2, : self.count], np.sqrt(numbers.weights.sum(axis=1)[: self.count])
        soft = phi.T * (numbers.frequency / (numbers.decay**2 + numbers.frequency**2)) @ phi
        return float(np.linalg.eigvalsh(root[:, None] * soft * root).max())


def springs_of(start: LinearStart, largest: Steady, count: int) -> tuple[Springs, np.ndarray]:
    """Springs of next to no weight in a linear model, and where the search begins.

    The first springs act on the modes as the actuators do, further ones as the outputs see them.
    """
    model = start.model
    if (model.poles_rad_s.imag == 0).any():
        sys.exit("the linear model has a real pole; take another order")
    turn = np.exp(-0.5j * np.angle(np.sum(model.input_vectors**2, axis=1)))  # forces lie along x1 of their mode
    b, c = model.input_vectors * turn[:, None], 2.0 * model.output_vectors / turn[None, :]
    inputs, outputs, modes = b.shape[1], c.shape[0], b.shape[0]
    phi = np.hstack([b.real, c.imag.T * np.abs(b).max() / np.abs(c).max()])[:, np.arange(count) % (inputs + outputs)]
    operators, plays = count + inputs, len(THRESHOLDS)

    def rows(values: np.ndarray) -> np.ndarray:
        return np.stack([values.real, values.imag], axis=1).reshape(2 * modes, -1)

    E, F = np.zeros((2 * modes, operators)), np.zeros((operators, 2 * modes))
    E[0::2, :count], E[:, count:], F[:count, 1::2] = phi, rows(b), phi.T
    D = model.direct.copy()
    numbers = Numbers(
        decay=model.poles_rad_s.real.copy(),
        frequency=model.poles_rad_s.imag.copy(),
        B=rows(b),
        E=E,
        F=F,
        G=np.vstack([np.zeros((count, inputs)), np.eye(inputs)]),
        weights=np.full((operators, plays), 1e-3),
        C=np.stack([c.real, -c.imag], axis=2).reshape(outputs, -1),
        D=D,
        K=np.hstack([np.zeros((outputs, count)), D]),
        thresholds=np.full((operators, plays), 1e300),
        delay_s=start.delay_s,
    )
    drive = tangents.two_periods(largest, start.delay_s)
    path = tangents.simulate_path(tangents.play_plant(numbers, largest.step_s), drive)
    farthest = float(np.abs(drive).max())
    scale = farthest / np.abs(path.x @ F[:count].T)[len(drive) // 2 :].max(axis=0)
    E[:, :count] *= scale
    F[:count] *= scale[:, None]
    numbers = replace(numbers, thresholds=np.zeros_like(numbers.thresholds) + farthest * np.array(THRESHOLDS))
    return _free(numbers, count)


def _free(numbers: Numbers, count: int) -> tuple[Springs, np.ndarray]:
    place, begin = {}, 0
    for name in FIELDS:
        size = getattr(numbers, name).size
        place[name] = np.arange(begin, begin + size).reshape(getattr(numbers, name).shape)
        begin += size
    E, F = place["E"], place["F"]
    groups = [("phi", [[i, j] for i, j in zip(E[0::2, :count].ravel(), F[:count, 1::2].T.ravel(), strict=True)])]
    own = {"E": E[:, count:], "G": place["G"][:count]}
    groups += [(f, [[i] for i in own.get(f, place[f]).ravel()]) for f in FIELDS if f != "F"]
    groups.append(("delay", [[begin]]))
    kinds = np.array([name for name, places in groups for _ in places])
    matrix = np.zeros((begin + 1, kinds.size))
    for column, places in enumerate(each for _, group in groups for each in group):
        matrix[places, column] = 1.0
    vector = numbers.vector()
    free = np.where(kinds == "weights", np.sqrt(np.abs(matrix.T @ vector)), matrix.T @ vector / matrix.sum(axis=0))
    rest = np.where(matrix.any(axis=1), 0.0, vector)
    return Springs(numbers, count, matrix, rest, kinds), free


# --------------------------------------------------------------------------------------------------------- the search
class Search:
    """Least squares over all records, each counted in units of what no linear model of its amplitude could follow."""

    def __init__(self, springs: Springs, records: Sequence[Steady], weights: np.ndarray, few: Sequence[int]) -> None:
        self.springs, self.records, self.weights, self.few = springs, records, weights, few
        self.pool = ThreadPoolExecutor(os.cpu_count())

    def cost(self, free: np.ndarray) -> float:
        numbers = self.springs.numbers(free)
        if (numbers.frequency <= 0).any() or (numbers.decay >= 0).any() or self.springs.given(numbers) > MOST_GIVEN:
            return math.inf
        try:
            plant = tangents.play_plant(numbers, self.records[0].step_s)
        except ValueError:  # the loop through the plays is no contraction at this step
            return math.inf
        found = self.pool.map(lambda r: tangents.squared_error(plant, r, numbers.delay_s), self.records)
        return float(self.weights @ np.array(list(found)))

    def gradient(self, free: np.ndarray) -> np.ndarray:
        numbers = self.springs.numbers(free)
        found = list(self.pool.map(lambda r: gradient(numbers, r), self.records))
        return np.asarray(self.springs.slopes(free).T @ (self.weights @ np.array(found)))

    def curvature(self, free: np.ndarray) -> np.ndarray:
        """Of a few records, scaled to all."""
        numbers, slopes = self.springs.numbers(free), self.springs.slopes(free)
        plant = tangents.play_plant(numbers, self.records[0].step_s)
        own = self.weights[list(self.few)]
        parts = self.pool.map(lambda k: tangents.normal_equations(plant, numbers, self.records[k]).matrix, self.few)
        matrix = sum(w * part for w, part in zip(own, parts, strict=True))
        return np.asarray(2.0 * self.weights.sum() / own.sum() * slopes.T @ matrix @ slopes)

    def size(self, curvature: np.ndarray) -> np.ndarray:
        """Scale of each number; one that hardly acts yet has that of its kind."""
        diagonal = np.diag(curvature).copy()
        for kind in dict.fromkeys(self.springs.kinds.tolist()):
            own = self.springs.kinds == kind
            diagonal[own] += 0.03 * diagonal[own].mean()
        return np.sqrt(diagonal)

    def minimise(self, free: np.ndarray, iterations: int, on_step) -> np.ndarray:
        """The numbers at the end of a search; `on_step` is told the steps done, the numbers and the cost."""
        damping, cost, slope = 1e-2, self.cost(free), self.gradient(free)
        pairs: list[tuple[np.ndarray, np.ndarray]] = []
        since, refused = REFRESH, 0
        for done in range(1, iterations + 1):
            if since >= min(REFRESH, 2 + done // 3):
                matrix = self.curvature(free)
                size, since = self.size(matrix), 0
                matrix /= np.outer(size, size)
            move = -_newton(cho_factor(matrix + damping * np.eye(size.size)), pairs, slope, size)
            trial, found, refusals = _along(self, free, move, cost, float(slope @ move))
            if found == cost:
                damping, since, refused = 8 * damping, REFRESH, refused + 1
                pairs.clear()
                if refused > TRIALS:
                    break
                continue
            damping, refused, since = (3 * damping if refusals else max(damping / 2, 1e-6)), 0, since + 1
            before, slope = slope, self.gradient(trial)
            if (trial - free) @ (slope - before) > 0.0:
                pairs = [*pairs, (trial - free, slope - before)][-MEMORY:]
            free, cost = trial, found
            on_step(done, free, cost)
        return free


def _newton(factor: tuple, pairs: list, slope: np.ndarray, size: np.ndarray) -> np.ndarray:
    """Inverse curvature times the slope: that of a few records, corrected by the last steps (two loops of L-BFGS)."""
    scaled_pairs = [(s * size, y / size) for s, y in pairs]
    direction, shares = slope / size, []
    for s, y in reversed(scaled_pairs):
        shares.append((s @ direction) / (s @ y))
        direction = direction - shares[-1] * y
    direction = cho_solve(factor, direction)
    for (s, y), share in zip(scaled_pairs, reversed(shares), strict=True):
        direction = direction + s * (share - (y @ direction) / (s @ y))
    return np.asarray(direction / size)


def _along(
    search: Search, free: np.ndarray, move: np.ndarray, cost: float, slope: float
) -> tuple[np.ndarray, float, int]:
    """Where a step leads that lowers the cost, its cost (as before if none does), and how many were tried in vain."""
    step, refusals = 1.0, 0
    for _ in range(12):
        trial = free + step * move
        found = search.cost(trial)
        if found < cost + 1e-4 * step * slope:
            return trial, found, refusals
        refusals += math.isfinite(found)
        if refusals >= 2:
            break
        step *= 0.3 if math.isfinite(found) else 0.5
    return free, cost, refusals


def main() -> None:
    options = {"held": 5, "order": 36, "springs": 6, "iterations": 120}
    options |= {key: int(value) for key, value in (word.split("=") for word in sys.argv[1:])}
    groups, held = realisations(), options["held"]
    began, spent = time.perf_counter(), time.process_time()
    units = tuple(np.sqrt(np.mean([np.var(getattr(r, c), axis=0) for r in all_but(groups, held)])) for c in CHANNELS)
    used = [[replace(r, drive=r.drive / units[0], output=r.output / units[1]) for r in g] for g in groups]
    used = [[r for k, r in enumerate(group) if k != held] for group in used]
    records = [steady(r) for group in used for r in group]
    responses = [response_from_periods(group) for group in used]
    left = np.repeat([float(r.residual_power.sum(axis=0).mean()) for r in responses], len(used[0]))
    weights = 1.0 / (left * records[0].output.size * len(records))
    delay_s = best_delay(responses[1], DELAY_ORDER, STEPS)
    start = linear_start(responses[1], options["order"], STEPS, delay_s, 12)
    springs, free = springs_of(start, records[-1], options["springs"])
    print(
        f"order {options['order']}, {free.size} numbers; s by the clock and of processor time; given way; um",
        flush=True,
    )

    def told(done: int, free: np.ndarray, cost: float) -> None:
        if done % 10 == 0:
            numbers = springs.numbers(free)
            whole = scaled(numbers, *units).mirror("springs")
            errors = [
                score_um(lambda u: coupled.response(whole, u, 6400.0, STEPS, numbers.delay_s), g[held]) for g in groups
            ]
            clock = f"{time.perf_counter() - began:6.0f}{time.process_time() - spent:6.0f}"
            scores = "".join(f"{e:9.4f}" for e in errors)
            print(f"{done:5d} {math.sqrt(cost):8.4f}{clock}{springs.given(numbers):8.3f}{scores}", flush=True)

    few = [len(used[0]) * k + 2 for k in range(len(AMPLITUDES_MV))]
    Search(springs, records, weights, few).minimise(free, options["iterations"], told)


if __name__ == "__main__":
    main()
