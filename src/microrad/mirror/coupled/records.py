"""A mirror of several axes as it was identified: the plant form, its channels, and how well its numbers are known.

    x' = A x + B u + E z        q = F x + G u        z = H[q]        y = C x + D u + K z

A is in real modal form. Drive and output count from rest at the bias; q and z are counted in volts.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from microrad.core import lti, periodic
from microrad.core.arrays import Floats
from microrad.mirror import model
from microrad.mirror.model import Mirror


@dataclass(frozen=True, slots=True)
class Actuator:
    """One drive: its bias, and the range and the rate that it was identified for, in V and V/s."""

    name: str
    bias_v: float
    drive_min_v: float
    drive_max_v: float
    rate_limit_v_s: float


@dataclass(frozen=True, slots=True)
class Output:
    """One sensor: a displacement (m) along z, which leaves the mirror's face, or an angle (rad).

    ``position_m`` is where a displacement is measured, (x, y) in the plane of the mirror; None where it is not known.
    """

    name: str
    quantity: Literal["displacement", "angle"]
    position_m: tuple[float, float] | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Known:
    """What is known of the parameters: standard errors, absolute and in SI units, and the root of their correlation.

    ``parameters`` are called as in a mirror file: "modes.decay.3" and "modes.frequency.1" (mode, from 1),
    "matrices.B.5.2" (row and column, from 1), "hysteresis.2.weights.4", "hysteresis.1.epsilon", "recording.delay". A
    decay is above 0, minus the real part of the pole. ``factor`` has one row of length 1 for each parameter: the
    correlation is factor @ factor.T.
    """

    parameters: tuple[str, ...]
    standard_errors: Floats
    factor: Floats

    @property
    def correlation(self) -> Floats:
        """Correlation of the parameters, shape (parameters, parameters)."""
        return np.asarray(self.factor @ self.factor.T)


@dataclass(frozen=True, slots=True, eq=False)
class CoupledMirror:
    """A mirror of any number of actuators and outputs, and the recordings that it was identified from.

    ``delay_s`` belongs to the recording chain (converters, anti-alias filter, amplifier), not to the mirror: the model
    takes the drive of that long ago. ``steps_per_sample`` steps at ``rate_hz`` are those that it was fitted with; a
    plant of another step is another approximation of the loop through the hysteresis. ``excited_hz`` is the band with a
    drive in it.

    Raises ValueError where the channels are not those of the plant, or its A is in no real modal form.
    """

    mirror: Mirror
    actuators: tuple[Actuator, ...]
    outputs: tuple[Output, ...]
    delay_s: float
    rate_hz: float
    steps_per_sample: int
    excited_hz: tuple[float, float]
    known: Known | None = None

    def __post_init__(self) -> None:
        """Check what does not fit together."""
        modes(self.mirror.A)
        for name, given, needed in (
            ("actuators", len(self.actuators), self.mirror.actuators),
            ("outputs", len(self.outputs), self.mirror.axes),
        ):
            if given != needed:
                raise ValueError(f"{given} {name} are named, and the mirror has {needed}; name each, in their order")

    @property
    def step_s(self) -> float:
        """Step of the plant, in s."""
        return 1.0 / (self.rate_hz * self.steps_per_sample)

    def response(self, drive_v: Floats) -> Floats:
        """Output (samples, outputs) from rest, in m or rad; see `response`.

        Args:
            drive_v: Drive from the bias, in V, shape (samples, actuators), at `rate_hz`.
        """
        return response(self.mirror, drive_v, self.rate_hz, self.steps_per_sample, self.delay_s)


def response(mirror: Mirror, drive_v: Floats, rate_hz: float, steps_per_sample: int, delay_s: float) -> Floats:
    """Output (samples, outputs) of a mirror from rest, behind a delay.

    Between samples the drive is interpolated without content above half the rate and shifted by the delay, both around
    the corner: the drive is to hold whole periods, or to begin and end at rest. Then the mirror runs from rest, the
    drive straight over each of its steps.

    Args:
        mirror: The mirror, continuous in time.
        drive_v: Drive from the bias, in V, shape (samples, actuators).
        rate_hz: Samples of the drive a second.
        steps_per_sample: Steps of the plant a sample.
        delay_s: Delay of the drive, in s, positive for later.

    Raises:
        ValueError: For a drive of another shape, and where the loop through the hysteresis is no contraction.
    """
    if drive_v.ndim != 2 or drive_v.shape[1] != mirror.actuators or not drive_v.size:
        raise ValueError(
            f"the drive has the shape {drive_v.shape}; give samples x {mirror.actuators}, a column for each actuator "
            f"of {mirror.name!r}"
        )
    fine = periodic.delayed(drive_v, rate_hz, delay_s, steps_per_sample)
    plant = model.discretise(mirror, 1.0 / (rate_hz * steps_per_sample))
    output = np.empty((fine.shape[0], mirror.axes))
    model.respond(plant, model.at_rest(plant), fine, output, np.empty((fine.shape[0], 0)))
    return np.ascontiguousarray(output[::steps_per_sample])


def modes(A: Floats) -> tuple[tuple[float, float], ...]:
    """Real and imaginary part (rad/s) of the modes of a matrix in real modal form, in the order of its states.

    A mode with an imaginary part w (of either sign) stands for two states with the block [[s, -w], [w, s]].

    Args:
        A: The matrix, shape (states, states).

    Raises:
        ValueError: Where it has another form.
    """
    found: list[tuple[float, float]] = []
    row, states = 0, A.shape[0]
    while row < states:
        w = float(A[row + 1, row]) if row + 1 < states else 0.0
        found.append((float(A[row, row]), w))
        row += 2 if w else 1
    if not np.array_equal(A, lti.modal_matrix(found)):
        raise ValueError(
            "A is not block-diagonal with a block [[s, -w], [w, s]] for each pair of poles and s for each real one; "
            "bring the mirror into real modal form first"
        )
    return tuple(found)
