"""The known part of the pointing error of one axis: what the loop must follow and no filter has to guess."""

import math
from dataclasses import dataclass, fields

import numpy as np

from microrad.core.arrays import Floats
from microrad.loop.disturbance.records import above_zero, at_least_zero


@dataclass(frozen=True, slots=True)
class Reference:
    """Point-ahead, what the body leaves of the orbital motion of the line of sight, and a sine; one axis.

    The body follows the line of sight's rate with a loop of first order and one bandwidth, from rest at time 0. Raises
    ValueError for a number that is not finite, a bandwidth not above zero and a negative frequency of the sine.
    """

    point_ahead_rad: float
    line_of_sight_rate_rad_s: float
    body_bandwidth_hz: float
    sine_amplitude_rad: float = 0.0
    sine_freq_hz: float = 0.0

    def __post_init__(self) -> None:
        """Check each number."""
        for field in fields(self):
            value = getattr(self, field.name)
            if not math.isfinite(value):
                raise ValueError(f"{field.name} of a pointing reference is {value}; give a finite number")
        above_zero(self.body_bandwidth_hz, "bandwidth of the body's loop in a pointing reference", "Hz")
        at_least_zero(self.sine_freq_hz, "frequency of the sine in a pointing reference", "Hz")

    def at(self, time_s: Floats) -> Floats:
        """Reference (rad) at these times (s).

        point-ahead + rate / (2 pi f_b) (1 - exp(-2 pi f_b t)) + amplitude sin(2 pi f t): the lag of a first-order loop.
        """
        time = np.asarray(time_s, dtype=float)
        body = 2.0 * math.pi * self.body_bandwidth_hz
        lag = -self.line_of_sight_rate_rad_s / body * np.expm1(-body * time)
        sine = self.sine_amplitude_rad * np.sin(2.0 * math.pi * self.sine_freq_hz * time)
        return np.asarray(self.point_ahead_rad + lag + sine)


@dataclass(frozen=True, slots=True)
class Misalignment:
    """A static offset and a steady drift of one axis, of which no controller knows: offset + rate t.

    Raises ValueError for a number that is not finite.
    """

    offset_rad: float
    rate_rad_s: float

    def __post_init__(self) -> None:
        """Check each number."""
        if not (math.isfinite(self.offset_rad) and math.isfinite(self.rate_rad_s)):
            raise ValueError(
                f"a misalignment of {self.offset_rad:g} rad and {self.rate_rad_s:g} rad/s; give finite numbers"
            )

    def at(self, time_s: Floats) -> Floats:
        """Misalignment (rad) at these times (s)."""
        return self.offset_rad + self.rate_rad_s * np.asarray(time_s, dtype=float)


NO_REFERENCE = Reference(0.0, 0.0, 1.0)


class SampledReference(Reference):
    """The reference of one axis by its samples at the control period; the last one holds on behind them."""

    def __init__(self, samples_rad: Floats, period_s: float) -> None:
        """The samples.

        Args:
            samples_rad: Reference at the control samples (rad), shape (samples,).
            period_s: Control period (s).
        """
        super().__init__(0.0, 0.0, 1.0)
        object.__setattr__(self, "_samples_rad", samples_rad)
        object.__setattr__(self, "_period_s", period_s)

    def at(self, time_s: Floats) -> Floats:
        """Reference (rad) at these times (s), each that of a control sample."""
        samples: Floats = self._samples_rad
        place = np.rint(np.asarray(time_s, dtype=float) / self._period_s).astype(int)
        return np.asarray(samples[np.minimum(place, samples.size - 1)])

    _samples_rad: Floats
    _period_s: float
