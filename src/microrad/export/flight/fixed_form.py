"""The linear part of a controller in fixed point: whole numbers with powers of two as units, and a step of it.

A number of the code stands for ``integer 2^-scale``. States move by their change,

    x[k+1] = x[k] + (A - 1) x~ + B m + L (clip(v) - v),       outputs = C x~ + D m,

where x is kept with all bits of the products (64 bits) and x~ is x rounded to a word. No product is rounded, so an
integrator adds up the smallest reading, there is no dead band, and what rounds x~ is weighted by A - 1: its noise has
a zero at frequency 0 (error feedback; Thong and Liu, IEEE Trans. Circuits Syst. 24 (1977) 181). Each row of the
matrices has its own scale, the finest at which the sum of its coefficients' sizes is within a word: whatever the
readings, no sum leaves 64 bits, and what grows beyond its range stays at its end.
"""

import math
import sys
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from microrad.core.arrays import Floats
from microrad.export.flight.double_run import Forward, Inverse, Run
from microrad.export.flight.rounding import responses
from microrad.export.linear_part.sections import Sections
from microrad.export.records import FlightController

Whole = NDArray[np.int64]
Poles = tuple[tuple[complex, complex], ...]
"""Pairs of a pole as designed and as quantised."""

HEAD_ROOM = 4.0
"""Range of each number over its largest size in the recorded run."""

_REACH_SAMPLES = 4096  # of an impulse response


@dataclass(frozen=True, slots=True)
class Rows:
    """A matrix in whole numbers: each is the entry times 2^(``scale`` of its row - scale of its column's signal)."""

    value: Whole
    scale: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class Converter:
    """Command to counts: (command ``factor`` + half) >> ``shift``, then within ``lowest`` and ``highest``."""

    factor: int
    shift: int
    lowest: int
    highest: int


@dataclass(frozen=True, slots=True)
class OutputQuality:
    """What fixed point does to one output, in its ``unit``.

    ``response_error`` is the largest relative error of its frequency response (norm over the inputs), at ``at_hz``. The
    noise of rounding is an rms, as predicted and as measured over the run. ``cycle_bound`` is the largest swing (peak
    to peak) that rounding can sustain without input, ``cycle_found`` the one that was found.
    """

    name: str
    unit: str
    response_error: float
    at_hz: float
    noise_predicted: float
    noise_measured: float
    cycle_bound: float
    cycle_found: float


@dataclass(frozen=True, slots=True)
class QuantisationReport:
    """What fixed point costs over a recorded run of ``samples``.

    ``head_room_bits`` go by state, from the largest size in the run. ``error_v`` is the largest difference from double
    precision that fixed point makes in a command ahead of the converter; ``inverse_v`` bounds what single precision in
    the inverse or the feedforward adds to it. ``bound_v`` bounds both together behind the converter.
    """

    samples: int
    period_s: float
    poles: Poles
    outputs: tuple[OutputQuality, ...]
    head_room_bits: tuple[float, ...]
    error_v: float
    inverse_v: float
    resolution_v: float
    bound_v: float


@dataclass(frozen=True, slots=True)
class FixedForm:
    """A controller's linear part in words of ``bits``; scales are by number of the inputs, states and outputs.

    ``state`` is [A - 1, B, L] and ``output`` [C, D] side by side. A state is kept with its row's scale, and rounded to
    ``state_scale`` where it is used. ``minimum`` and ``maximum`` are the limits of the commands in their scale.
    """

    bits: int
    input_scale: tuple[int, ...]
    state_scale: tuple[int, ...]
    output_scale: tuple[int, ...]
    state: Rows
    output: Rows
    minimum: tuple[int, ...]
    maximum: tuple[int, ...]
    converter: tuple[Converter, ...]
    report: QuantisationReport

    @property
    def word(self) -> int:
        """Largest number of a word; the smallest is its negative."""
        return int(2 ** (self.bits - 1) - 1)

    @property
    def state_shift(self) -> tuple[int, ...]:
        """Bits that a state keeps below its word."""
        return tuple(a - b for a, b in zip(self.state.scale, self.state_scale, strict=True))

    @property
    def output_shift(self) -> tuple[int, ...]:
        """Bits of an output's sum below its word."""
        return tuple(a - b for a, b in zip(self.output.scale, self.output_scale, strict=True))


def scaled(of: FlightController, form: Sections, inputs: Floats, ideal: Run, bits: int) -> FixedForm:
    """The controller in fixed point, scaled by a recorded run; its report is still empty.

    Args:
        of: The controller.
        form: Its linear part.
        inputs: The recorded readings, shape (samples, numbers), SI units.
        ideal: The same run in double precision.
        bits: Bits of coefficients and signals, the sign among them.
    """
    word = 2 ** (bits - 1) - 1
    peaks: list[float] = []  # of the inputs, the same for all numbers of a signal; its limit where it rests
    for s in of.inputs:
        peak = float(np.max(np.abs(inputs[:, len(peaks) : len(peaks) + s.size]), initial=0.0))
        peaks += [peak or s.limit] * s.size
    sizes = np.array(peaks) * HEAD_ROOM
    states = _or_reachable(np.max(np.abs(ideal.states), axis=0) * HEAD_ROOM, np.eye(form.order), form, sizes)
    ranges = _output_ranges(of, form, ideal, sizes)
    read, kept, given = (tuple(_scale(float(x), word) for x in most) for most in (sizes, states, ranges))
    step = np.hstack([form.A - np.eye(form.order), form.B, form.L])
    from_v = given[: of.actuators]
    state = _rows(step, (*kept, *read, *from_v), word, [s + bits - 1 for s in kept])
    output = _rows(np.hstack([form.C, form.D]), (*kept, *read), word, [s + 61 for s in given])
    low = tuple(-word if math.isinf(of.minimum_v) else math.ceil(math.ldexp(of.minimum_v, s)) for s in from_v)
    high = tuple(word if math.isinf(of.maximum_v) else math.floor(math.ldexp(of.maximum_v, s)) for s in from_v)
    converters = tuple(_converter(of, s) for s in from_v) if of.resolution_v > 0.0 else ()
    empty = QuantisationReport(0, of.period_s, (), (), (), 0.0, 0.0, of.resolution_v, 0.0)
    return FixedForm(bits, read, kept, given, state, output, low, high, converters, empty)


def _scale(size: float, word: int) -> int:
    """Finest power of two at which numbers up to ``size`` fit into a word."""
    return math.floor(math.log2(min(word / size, sys.float_info.max)))


def _or_reachable(peaks: Floats, rows: Floats, form: Sections, inputs: Floats) -> Floats:
    """Peaks, where there are some; else what inputs of these sizes can make of ``rows`` x at most."""
    found = peaks.copy()
    for i in np.flatnonzero(peaks == 0.0):
        gains = np.sum(np.abs(responses(rows[i], form.A, _REACH_SAMPLES) @ form.B), axis=0)
        found[i] = float(gains @ inputs) or 1.0
    return found


def output_groups(of: FlightController) -> tuple[tuple[str, str, int], ...]:
    """Kinds of the outputs of the linear part, in their order: each with its unit and how many numbers it has."""
    n, outputs = of.actuators, of.system.C.shape[0]
    if of.forward is not None:
        return ("v", "V", n), ("drive of hysteresis", "V", outputs - n)
    kinds = (("v", "V"), ("target", "rad"), ("target's rate", "rad/s"), ("error of the reading", "rad"))
    return tuple((kind, unit, n) for kind, unit in kinds[: outputs // n])


def _output_ranges(of: FlightController, form: Sections, ideal: Run, inputs: Floats) -> Floats:
    """Ranges of the outputs, the same for all of a kind: of v, that of the commands and of their limits."""
    sizes = [size for _, _, size in output_groups(of)]
    first = np.cumsum([0, *sizes[:-1]])
    peaks = np.maximum.reduceat(np.max(np.abs(ideal.outputs), axis=0), first)
    limits = [abs(x) for x in (of.minimum_v, of.maximum_v) if math.isfinite(x)]
    peaks[0] = max(*limits, peaks[0], float(np.max(np.abs(ideal.free))))
    groups = _or_reachable(peaks * HEAD_ROOM, form.C[first], form, inputs)
    return np.repeat(groups, sizes)


def _rows(matrix: Floats, columns: tuple[int, ...], word: int, most: list[int]) -> Rows:
    """Each row at the finest scale, up to ``most``, at which the sum of its sizes is within a word."""
    values, scales = np.zeros(matrix.shape, dtype=np.int64), []
    for i, row in enumerate(matrix):
        weights = row * np.exp2(-np.array(columns, dtype=float))
        size = float(np.sum(np.abs(weights)))
        scale = most[i] if size == 0.0 else min(most[i], _scale(size, word))
        while np.sum(np.abs(np.rint(np.ldexp(weights, scale)))) > word:
            scale -= 1
        values[i] = np.rint(np.ldexp(weights, scale)).astype(np.int64)
        scales.append(scale)
    return Rows(values, tuple(scales))


def _converter(of: FlightController, scale: int) -> Converter:
    r, near = of.resolution_v, 1e-6  # a limit that is a multiple of the resolution up to rounding is one of its counts
    counts = math.ldexp(1.0, -scale) / r
    shift = 30 - math.frexp(counts)[1]
    ends = [-(2**31) + 1, 2**31 - 1]
    if math.isfinite(of.minimum_v):
        ends[0] = math.ceil(of.minimum_v / r - near)
    if math.isfinite(of.maximum_v):
        ends[1] = math.floor(of.maximum_v / r + near)
    return Converter(round(math.ldexp(counts, shift)), shift, *ends)


def dequantised(form: Sections, made: FixedForm) -> Sections:
    """The linear part with the coefficients that the whole numbers stand for.

    Args:
        form: The linear part as designed.
        made: The same in fixed point.
    """
    n, m = form.order, form.B.shape[1]
    columns = np.array([*made.state_scale, *made.input_scale, *made.output_scale[: form.L.shape[1]]])
    step = _values(made.state, columns)
    output = _values(made.output, columns[: n + m])
    A, B, L = step[:, :n] + np.eye(n), step[:, n : n + m], step[:, n + m :]
    return replace(form, A=A, B=B, C=output[:, :n], D=output[:, n:], L=L)


def _values(rows: Rows, columns: NDArray[np.integer[Any]]) -> Floats:
    exponents = columns[None, :] - np.array(rows.scale, dtype=int)[:, None]
    return np.asarray(np.ldexp(rows.value.astype(float), exponents))


# ------------------------------------------------------------------------------------------------------------- the step
class Step:
    """The step in whole numbers, as the C code has it: states are kept with the scales of their rows."""

    def __init__(self, made: FixedForm, states: Whole | None = None) -> None:
        """At rest, or with ``states``."""
        n = len(made.state_scale)
        self.of, self.x = made, np.zeros(n, dtype=np.int64) if states is None else states.copy()
        self.shift, self.out_shift = np.array(made.state_shift, dtype=int), np.array(made.output_shift, dtype=int)
        self.end = np.int64(made.word) << self.shift.astype(np.int64)
        self.read = np.zeros(len(made.input_scale), dtype=np.int64)

    def output(self, reading: Whole) -> Whole:
        """Outputs for the readings of a sample; `update` has to follow."""
        self.read = np.clip(reading, -self.of.word, self.of.word)
        total = self.of.output.value @ np.concatenate([_rounded(self.x, self.shift), self.read])
        return np.asarray(np.clip(_rounded(total, self.out_shift), -self.of.word, self.of.word))

    def update(self, excess: Whole) -> None:
        """Move the states on; ``excess`` is what the limits took off the commands."""
        excess = np.clip(excess, -self.of.word, self.of.word)
        signals = np.concatenate([_rounded(self.x, self.shift), self.read, excess])
        self.x = np.clip(self.x + self.of.state.value @ signals, -self.end, self.end)


def _rounded(x: Whole, shift: NDArray[np.integer[Any]]) -> Whole:
    """x / 2^shift to the nearest, ties up."""
    half = np.where(shift > 0, np.int64(1) << np.maximum(shift - 1, 0).astype(np.int64), 0)
    return np.asarray((x + half) >> shift.astype(np.int64))


def readings(made: FixedForm, inputs: Floats) -> Whole:
    """Readings as whole numbers in the scales of the inputs; what is beyond the range stays at its end.

    Args:
        made: The controller in fixed point, for its scales.
        inputs: The readings in SI units, shape (samples, numbers).
    """
    counts = np.floor(np.ldexp(inputs, np.array(made.input_scale, dtype=int)) + 0.5)
    return np.asarray(np.clip(counts, -made.word, made.word).astype(np.int64))


def fixed_run(of: FlightController, made: FixedForm, inputs: Floats) -> tuple[Floats, Floats, Whole]:
    """Run the controller in fixed point: its outputs, its commands ahead of the clip, and its states at the end.

    Outputs (samples, outputs) and commands (samples, actuators; V) are in SI units, the states whole numbers in their
    scales. What an inverse or a feedforward adds is taken in double precision.

    Args:
        of: The controller, for its inverse or feedforward.
        made: Its linear part in fixed point.
        inputs: The recorded readings in SI units, shape (samples, numbers).
    """
    read, step, n = readings(made, inputs), Step(made), of.actuators
    outputs, free = np.empty((len(read), len(made.output_scale))), np.empty((len(read), n))
    inverse = None if of.inverse is None else Inverse(of, len(read))
    forward = None if of.forward is None else Forward(of.forward, len(read))
    down, up = -np.array(made.output_scale, dtype=int), np.array(made.output_scale[:n], dtype=int)
    low, high = np.array(made.minimum), np.array(made.maximum)
    for k, reading in enumerate(read):
        y = step.output(reading)
        outputs[k] = np.ldexp(y.astype(float), down)
        command = y[:n]
        if inverse is not None:
            command = command + np.floor(np.ldexp(inverse.step(outputs[k]), up) + 0.5).astype(np.int64)
        if forward is not None:
            command = command + np.floor(np.ldexp(forward.step(outputs[k, n:]), up) + 0.5).astype(np.int64)
        free[k] = np.ldexp(command.astype(float), down[:n])
        step.update(np.clip(command, low, high) - command)
    return outputs, free, step.x
