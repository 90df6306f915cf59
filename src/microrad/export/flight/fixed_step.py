"""The step in fixed point, number for number as the C code has it."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from microrad.export.flight.double_run import Inverse
from microrad.export.flight.fixed_form import FixedForm, Whole
from microrad.export.records import FlightController, Floats


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
    """Inputs as whole numbers of their scales, at the end of the range where they are beyond it."""
    counts = np.floor(np.ldexp(inputs, np.array(made.input_scale, dtype=int)) + 0.5)
    return np.asarray(np.clip(counts, -made.word, made.word).astype(np.int64))


@dataclass(frozen=True, slots=True)
class FixedRun:
    """A run in whole numbers: outputs and the commands ahead of the clip in SI units, and the states at its end."""

    outputs: Floats
    free: Floats
    states: Whole


def fixed_run(of: FlightController, made: FixedForm, inputs: Floats) -> FixedRun:
    """The recorded run in fixed point; what an inverse adds is taken in double precision."""
    read, step, n = readings(made, inputs), Step(made), of.actuators
    outputs, free = np.empty((len(read), len(made.output_scale))), np.empty((len(read), n))
    inverse = None if of.inverse is None else Inverse(of, len(read))
    down, up = -np.array(made.output_scale, dtype=int), np.array(made.output_scale[:n], dtype=int)
    low, high = np.array(made.minimum), np.array(made.maximum)
    for k, reading in enumerate(read):
        y = step.output(reading)
        outputs[k] = np.ldexp(y.astype(float), down)
        command = y[:n]
        if inverse is not None:
            command = command + np.floor(np.ldexp(inverse.step(outputs[k]), up) + 0.5).astype(np.int64)
        free[k] = np.ldexp(command.astype(float), down[:n])
        step.update(np.clip(command, low, high) - command)
    return FixedRun(outputs, free, step.x)
