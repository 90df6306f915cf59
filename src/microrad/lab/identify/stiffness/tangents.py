"""Simulation of a mirror with hysteretic stiffness over a periodic record, and the derivatives of its output.

The path comes from the kernel's own step, the derivatives by the modes, the operators and their weights from forward
sensitivities along it, those by C, D and K from what the path holds, and that by the delay from a second path.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from microrad.core import kernels, periodic
from microrad.core.arrays import Floats
from microrad.lab.identify.linear.modal import hold_step
from microrad.lab.identify.stiffness.model import Numbers
from microrad.mirror import model as mirror

_CHUNK = 192
_STATE, _DRIVE, _BANK = range(3)  # where a parameter enters: the order of a chunk's columns
_LATER = 1e-5
_SETTLED = 7.0  # time constants of the slowest mode before tangents count
_MATRICES = ("B0", "B1", "E_held", "E1", "F", "G", "C", "D", "K")


@dataclass(frozen=True, eq=False)
class Steady:
    """One period of a record, the mean over its periods: drive and output without its mean; rate; steps a sample."""

    name: str
    drive: Floats
    output: Floats
    rate_hz: float
    sub_steps: int

    @property
    def step_s(self) -> float:
        """Step of the plant."""
        return 1.0 / (self.rate_hz * self.sub_steps)


class Normal(NamedTuple):
    """Sums over the samples and outputs of a record: squared error, J'J, J'error."""

    cost: float
    matrix: Floats
    gradient: Floats


def play_plant(numbers: Numbers, step_s: float) -> kernels.PlayPlant:
    """The discrete plant of a model.

    Args:
        numbers: The model's numbers.
        step_s: Step of the simulation, in s.

    Raises:
        ValueError: Where the model's loop through the plays is no contraction.
    """
    plant = mirror.discretise(numbers.mirror("trial"), step_s)
    values = {name: getattr(plant, name) for name in kernels.PlayPlant._fields}
    return kernels.PlayPlant(**values | {"play_start": plant.play_start.astype(np.int64)})


def simulate_path(plant: kernels.PlayPlant, drive: Floats) -> kernels.Path:
    """The path of a plant from rest: its output and all that is inside it, at every step.

    Args:
        plant: The discrete plant.
        drive: Drive at each step, shape (steps, inputs).
    """
    steps, operators = drive.shape[0], plant.K.shape[1]
    path = kernels.Path(
        output=np.empty((steps, plant.C.shape[0])),
        x=np.empty((steps, plant.diagonal.size)),
        state=np.empty((steps, plant.diagonal.size)),
        q=np.empty((steps, operators)),
        z=np.empty((steps, operators)),
        play=np.empty((steps, plant.play_threshold.size)),
        moved=np.empty((steps, operators), dtype=np.int64),
    )
    columns = {name: np.ascontiguousarray(getattr(plant, name).T) for name in _MATRICES}
    kernels.play_path(plant, plant._replace(**columns), np.ascontiguousarray(drive), np.empty(operators), path)
    return path


def powers(q: Floats, reach: Floats) -> Floats:
    """What the coefficients of each polynomial are multiplied by along a path, shape (steps, operators, 3).

    Args:
        q: Drive of each operator, shape (steps, operators).
        reach: Reach of each polynomial, infinite where an operator has none.
    """
    s = np.clip(q / reach, -1.0, 1.0)
    return np.stack([s * s, s * np.abs(s), s * s * s], axis=2)


def bend(plant: kernels.PlayPlant, path: kernels.Path) -> Floats:
    """Slope of each polynomial along a path, shape (steps, operators).

    Args:
        plant: The discrete plant.
        path: Its path.
    """
    quadratic, signed, cubic, reach = plant.operator[:, 2:].T
    s = path.q / reach
    slope = (2.0 * quadratic * s + 2.0 * signed * np.abs(s) + 3.0 * cubic * (s * s)) / reach
    return np.where(np.abs(s) < 1.0, slope, 0.0)


def two_periods(record: Steady, delay_s: float) -> Floats:
    """The drive of the plant for a record in its steady state: two periods, of which the second counts.

    Args:
        record: The record, one period of its steady state.
        delay_s: Delay of the drive, in s.
    """
    one = periodic.delayed(record.drive, record.rate_hz, delay_s, record.sub_steps)
    return np.concatenate([one, one])


def steady_error(plant: kernels.PlayPlant, record: Steady, delay_s: float) -> tuple[Floats, kernels.Path, Floats]:
    """Modelled less measured output (samples, outputs), without its mean; the path and the drive of both periods.

    Args:
        plant: The discrete plant.
        record: The record, one period of its steady state.
        delay_s: Delay of the drive, in s.
    """
    drive = two_periods(record, delay_s)
    path = simulate_path(plant, drive)
    error = path.output[drive.shape[0] // 2 :: record.sub_steps] - record.output
    return error - error.mean(axis=0), path, drive


def squared_error(plant: kernels.PlayPlant, record: Steady, delay_s: float) -> float:
    """Sum of the squared error; infinite where the model runs away.

    Args:
        plant: The discrete plant.
        record: The record, one period of its steady state.
        delay_s: Delay of the drive, in s.
    """
    with np.errstate(all="ignore"):
        cost = float(np.sum(steady_error(plant, record, delay_s)[0] ** 2))
    return cost if math.isfinite(cost) else math.inf


def normal_equations(
    plant: kernels.PlayPlant, numbers: Numbers, record: Steady, wanted: np.ndarray | None = None
) -> Normal:
    """Normal equations of a record in the order of `Numbers.vector`, in single precision, summed in double.

    Args:
        plant: The discrete plant of the model.
        numbers: The model's numbers, about which the equations are made linear.
        record: The record, one period of its steady state.
        wanted: Which numbers are, by default all; the others have neither row nor column.
    """
    error, path, drive = steady_error(plant, record, numbers.delay_s)
    J = jacobian(plant, numbers, record, (path, drive), np.float32, wanted=wanted)
    J -= J.mean(axis=0)
    J = J.reshape(-1, J.shape[2])
    flat = error.reshape(-1).astype(np.float32)
    return Normal(float(np.sum(error**2)), (J.T @ J).astype(float), (J.T @ flat).astype(float))


def curvature(
    plant: kernels.PlayPlant, numbers: Numbers, record: Steady, end: float, part: float, wanted: np.ndarray
) -> Floats:
    """J'J as in `normal_equations`, near enough for a search and sooner: from a part of the period, scaled to all.

    Args:
        plant: The discrete plant of the model.
        numbers: The model's numbers.
        record: The record, one period of its steady state.
        end: Where the part ends, as a part of the period.
        part: Part of the period that counts; the tangents begin as long before it.
        wanted: Which numbers are; the others have neither row nor column.
    """
    samples = len(record.output)
    rows = max(round(part * samples), 1)
    drive = two_periods(record, numbers.delay_s)[: (samples + max(round(end * samples), rows)) * record.sub_steps]
    path = simulate_path(plant, drive)
    J = jacobian(plant, numbers, record, (path, drive), np.float32, lead=rows, rows=rows, wanted=wanted)
    J -= J.mean(axis=0)
    J = J.reshape(-1, J.shape[2])
    return np.asarray((J.T @ J).astype(float) * (samples / rows))


def jacobian(
    plant: kernels.PlayPlant,
    numbers: Numbers,
    record: Steady,
    way: tuple[kernels.Path, Floats],
    kind: type,
    *,
    lead: int | None = None,
    rows: int | None = None,
    wanted: np.ndarray | None = None,
) -> Floats:
    """Derivative of the second period's output by each number, shape (samples, outputs, numbers).

    Args:
        plant: The discrete plant of the model.
        numbers: The model's numbers.
        record: The record, one period of its steady state.
        way: Path and drive over two periods, as `steady_error` gives them, or over what comes before an end.
        kind: Type of floating-point number of the result.
        lead: Samples before the first row at which the tangents begin, as far as there are any; by default seven time
            constants of the slowest mode.
        rows: Last samples before the end that are given; by default as many as the period has.
        wanted: Which numbers are, by their place in `Numbers.vector`, by default all; the others have no column.
    """
    path, drive = way
    wanted = np.ones(numbers.vector().size, dtype=bool) if wanted is None else wanted
    rows = len(record.output) if rows is None else rows
    first = len(drive) - rows * record.sub_steps
    lead = math.ceil(_SETTLED / -float(numbers.decay.max()) * record.rate_hz) if lead is None else lead
    lead = min(lead * record.sub_steps, first - 1)
    cut = slice(first - lead - 1, None)  # one step more: what enters needs the step before
    part = kernels.Path(**{name: values[cut] for name, values in path._asdict().items()})
    J: Floats = np.zeros((rows, record.output.shape[1], np.count_nonzero(wanted)), dtype=kind)
    _state_columns(J, (plant, numbers, record.step_s), (part, drive[cut]), (lead + 1, record.sub_steps), wanted)
    _output_columns(J, numbers, (path, drive), (first, record.sub_steps), wanted)
    if wanted[-1]:
        later = two_periods(record, numbers.delay_s + _LATER * record.step_s)[: len(drive)]
        later = simulate_path(plant, later).output
        J[:, :, -1] = (later - path.output)[first :: record.sub_steps] / (_LATER * record.step_s)
    return J


def _state_columns(
    J: Floats,
    model: tuple[kernels.PlayPlant, Numbers, float],
    way: tuple[kernels.Path, Floats],
    rows: tuple[int, int],
    wanted: np.ndarray,
) -> None:
    """Columns of what acts through the state, the drives of the operators or their weights."""
    (path, drive), (plant, numbers, step_s) = way, model
    places = _places(numbers)
    places = places[:, wanted[: places.shape[1]]]
    before, after = _sources(numbers, path, drive, step_s, J.dtype)
    signal = np.hstack([path.x[:, : numbers.B.shape[0]], drive]).astype(J.dtype)
    plays = np.hstack([path.play, powers(path.q, numbers.reach).reshape(len(drive), -1)]).astype(J.dtype)
    slopes = bend(plant, path).astype(J.dtype)
    for begin in range(0, places.shape[1], _CHUNK):
        chunk = slice(begin, min(begin + _CHUNK, places.shape[1]))
        tangents = _tangents(plant, places[:, chunk], (before, after, signal, plays, slopes), J.dtype)
        part = np.empty((*J.shape[:2], tangents.row.size), dtype=J.dtype)
        kernels.tangent_kernel(tangents, path.moved, 1, rows[0], rows[1], part)
        J[:, :, chunk] = part


def _tangents(
    plant: kernels.PlayPlant, places: np.ndarray, signals: tuple[Floats, ...], kind: np.dtype
) -> kernels.Tangents:
    states, operators, count = plant.diagonal.size, plant.K.shape[1], places.shape[1]
    once = mirror.retimed(plant)
    place, row, source, turned = np.ascontiguousarray(places)
    ends = np.array([np.count_nonzero(place == _STATE), np.count_nonzero(place != _BANK)])

    def zeros(rows: int) -> Floats:
        return np.zeros((rows, count), dtype=kind)

    before, after, signal, plays, slopes = signals
    live = np.asarray(plant.F.any(axis=1))
    live[row[ends[0] :]] = True
    return kernels.Tangents(
        plant=kernels.PlayPlant(*(v.astype(kind) if v.dtype == np.float64 else v for v in plant)),
        held=once.E.astype(kind),
        strain=once.H.astype(kind),
        through=once.K.astype(kind),
        live=np.flatnonzero(live),
        seen=np.flatnonzero(plant.F.any(axis=0)),
        places=ends,
        row=row,
        source=source,
        turned=turned,
        before=before,
        after=after,
        signal=signal,
        plays=plays,
        bend=slopes,
        x=zeros(states),
        q=zeros(operators),
        q_before=zeros(operators),
        z=zeros(operators),
        play=zeros(plant.play_threshold.size),
        still=zeros(operators),
        slope=np.zeros(operators, dtype=kind),
        moved=np.zeros(operators, dtype=np.int64),
    )


def _places(numbers: Numbers) -> np.ndarray:
    """Place, row, source and turn of each parameter that is not of the output, in the order of the Jacobian."""
    modes, pairs, first = numbers.decay.size, numbers.frequency.size, numbers.rows
    inputs, operators, order = numbers.B.shape[1], numbers.E.shape[1], numbers.B.shape[0]
    found = [(_STATE, first[i], i, 0) for i in range(modes)]
    found += [(_STATE, first[i], i, 1) for i in range(pairs)]
    states = [(i, turn) for i in range(modes) for turn in range(2 if i < pairs else 1)]
    for width, offset in ((inputs, modes), (operators, modes * (1 + inputs))):
        found += [(_STATE, first[i], offset + i * width + j, turn) for i, turn in states for j in range(width)]
    found += [(_DRIVE, e, i, 0) for e in range(operators) for i in range(order)]
    found += [(_DRIVE, e, order + j, 0) for e in range(operators) for j in range(inputs)]
    plays, offset = numbers.weights.shape[1], numbers.weights.size
    found += [(_BANK, e, e * plays + j, 0) for e in range(operators) for j in range(plays)]
    found += [(_BANK, e, offset + e * 3 + j, 0) for e in range(operators) for j in range(3)]
    return np.array(found, dtype=np.int64).T.copy()


def _sources(
    numbers: Numbers, path: kernels.Path, drive: Floats, step_s: float, kind: np.dtype
) -> tuple[Floats, Floats]:
    """What the poles, B and E add to the state of each mode: to the predicted state, and once the bank has moved."""
    steps, modes = drive.shape[0], numbers.decay.size
    step = hold_step(numbers.poles, "first-order", 1.0 / step_s)
    first, wide = numbers.rows, numbers.frequency.size

    def modal(states: Floats) -> np.ndarray:
        """States (..., order) as one complex number for each mode."""
        value = states[..., first].astype(complex)
        value[..., :wide] += 1j * states[..., 1 : 2 * wide : 2]
        return value

    change = np.diff(path.z, axis=0, prepend=path.z[:1])
    u0, u1, z0 = np.roll(drive, 1, axis=0), drive, np.roll(path.z, 1, axis=0)
    b, e = modal(numbers.B.T).T, modal(numbers.E.T).T
    forced, held, moved = u0 @ b.T, z0 @ e.T, change @ e.T
    state = np.roll(modal(path.state[:, : numbers.B.shape[0]]), 1, axis=0)
    pole = step.keep_rate * state + step.begin_rate * forced + step.end_rate * (u1 @ b.T)
    pole += (step.begin_rate + step.end_rate) * held
    inputs, width = modes * (1 + drive.shape[1]), modes * (1 + drive.shape[1] + path.z.shape[1])
    before, after = np.zeros((2, steps, width), dtype=np.complex64 if kind == np.float32 else np.complex128)
    begin, end, fine = (v.astype(before.dtype)[None, :, None] for v in (step.begin, step.end, step.begin + step.end))
    u0, u1, z0, change = (v.astype(kind)[:, None, :] for v in (u0, u1, z0, change))
    before[:, :modes], after[:, :modes] = pole, step.end_rate * moved
    before[:, modes:inputs] = (begin * u0 + end * u1).reshape(steps, -1)
    before[:, inputs:], after[:, inputs:] = (fine * z0).reshape(steps, -1), (end * change).reshape(steps, -1)
    return before.view(kind).reshape(steps, width, 2), after.view(kind).reshape(steps, width, 2)


def _output_columns(
    J: Floats, numbers: Numbers, way: tuple[kernels.Path, Floats], rows: tuple[int, int], wanted: np.ndarray
) -> None:
    """Columns of C, D and K: what they multiply, for each output alone."""
    path, drive = way
    used = slice(rows[0], None, rows[1])
    state = path.state[used, : numbers.B.shape[0]]
    first = wanted.size - 1 - numbers.C.size - numbers.D.size - numbers.K.size
    column = np.count_nonzero(wanted[:first])
    for factor in (state, drive[used], path.z[used]):
        for o in range(J.shape[1]):
            own = wanted[first : first + factor.shape[1]]
            count = np.count_nonzero(own)
            J[:, o, column : column + count] = factor[:, own]
            first, column = first + factor.shape[1], column + count
