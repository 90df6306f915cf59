"""Sources of pointing errors, as a budget takes them: what each is in time, over the ensemble, and about each axis."""

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal, get_args

import numpy as np

from microrad.core import lti
from microrad.core.arrays import Complexes, Floats
from microrad.link.error_budget.stationary import motion_behind
from microrad.link.pointing.error_classes import WORST_SATELLITE_SIGMAS
from microrad.loop.disturbance import Disturbance
from microrad.loop.disturbance.windows import Motion

SourceKind = Literal["constant", "per-observation", "random", "process", "periodic", "drift", "transient"]
SpreadShape = Literal["fixed", "gaussian", "uniform"]

_TIMED = {"process": (), "periodic": ("freq_hz",), "drift": ("period_s",), "transient": ("period_s", "decay_s")}


@dataclass(frozen=True, slots=True)
class Spread:
    """A size over the ensemble of satellites: what it is at a satellite that is drawn.

    Args:
        shape: "fixed": the same everywhere; "gaussian": about the mean; "uniform": evenly about the mean.
        mean: Mean over the ensemble (rad; rad/s of a drift).
        width: One standard deviation of a Gaussian, or the half width of an even spread (same unit), 0 if fixed.

    Raises:
        ValueError: For another shape, a number that is not finite, a negative width, and a fixed size with a width.
    """

    shape: SpreadShape
    mean: float
    width: float = 0.0

    def __post_init__(self) -> None:
        """Check what was given."""
        if self.shape not in get_args(SpreadShape):
            raise ValueError(f'no shape "{self.shape}" of a spread; give one of {", ".join(get_args(SpreadShape))}')
        if not (math.isfinite(self.mean) and 0.0 <= self.width < math.inf):
            raise ValueError(
                f"a spread of mean {self.mean:g} and width {self.width:g}: give finite ones, the width >= 0"
            )
        if self.shape == "fixed" and self.width:
            raise ValueError(f'a fixed size has no width, and {self.width:g} is given: say "gaussian" or "uniform"')

    @property
    def worst(self) -> float:
        """What it is at the worst-case satellite: the mean and, away from zero, three sigma or the half width."""
        out = self.width * (WORST_SATELLITE_SIGMAS if self.shape == "gaussian" else 1.0)
        return self.mean + math.copysign(out, self.mean)

    def times(self, factor: float) -> "Spread":
        """The same spread, so many times as large."""
        return Spread(self.shape, self.mean * factor, self.width * abs(factor))


@dataclass(frozen=True)
class ErrorSource:
    """One source of pointing errors.

    In time it is, by its kind,

    - "constant": the same at all times, a bias;
    - "per-observation": a bias that is another one in each observation period, as of a star tracker on other stars;
    - "random": anew from moment to moment, faster than any window: Gaussian of the standard deviation `size`, or even
      up to it where `even_in_time`;
    - "process": Gaussian with the spectrum of `process`, times `size`, a number;
    - "periodic": a sinusoid of amplitude `size` and random phase at `freq_hz`;
    - "drift": from zero at the rate `size` (rad/s), anew behind each `period_s`;
    - "transient": from `size` down with the time constant `decay_s`, anew behind each `period_s`.

    Args:
        name: What it is called.
        kind: Its class, as above.
        size: Its size over the ensemble: rad; rad/s of a drift; a factor of a process.
        transfer: How it reaches the axes: gains, shape (axes,), or a stable system of one input with an output by axis.
        process: Spectrum of a process, of one axis and unit size.
        freq_hz: Frequency of a periodic error (Hz).
        period_s: From one calibration to the next of a drift, from one event to the next of a transient (s).
        decay_s: Time constant of a transient (s).
        even_in_time: Whether a random error is even up to its size in time; Gaussian of that standard deviation else.
        apart: Whether each axis has an error of its own, as large as its gain; else one error reaches all of them.
        origin: Where the numbers come from.
        statistic: How its size was stated, such as "3-sigma"; "" where that is not known.

    Raises:
        ValueError: For another kind, a time that its kind lacks or has not, a transfer of another shape or one that is
            not stable.
    """

    name: str
    kind: SourceKind
    size: Spread
    transfer: Floats | lti.StateSpace
    process: Disturbance | None = None
    freq_hz: float | None = None
    period_s: float | None = None
    decay_s: float | None = None
    even_in_time: bool = False
    apart: bool = False
    origin: str = "given"
    statistic: str = ""

    def __post_init__(self) -> None:
        """Check the kind, what it needs, and the transfer."""
        if self.kind not in get_args(SourceKind):
            raise ValueError(f'{self.name}: no class "{self.kind}"; give one of {", ".join(get_args(SourceKind))}')
        needed = _TIMED.get(self.kind, ())
        for name in ("freq_hz", "period_s", "decay_s"):
            value = getattr(self, name)
            if (value is None) == (name in needed):
                what = f"needs {name}" if value is None else f"has no {name}"
                remedy = "give it" if value is None else "leave it out"
                raise ValueError(f"{self.name}: a {self.kind} error {what}; {remedy}")
            if value is not None and not 0.0 < value < math.inf:
                raise ValueError(f"{self.name}: {name} is {value:g}; give a finite number above zero")
        if (self.process is None) == (self.kind == "process"):
            raise ValueError(f"{self.name}: a spectrum belongs to a process, and to nothing else")
        if self.kind in ("random", "process") and min(self.size.mean, self.size.worst) < 0.0:
            raise ValueError(f"{self.name}: a {self.kind} error of size {self.size.mean:g}; give a size of 0 or above")
        if self.process is not None and self.process.lines and self.size.shape != "fixed":
            raise ValueError(f"{self.name}: the lines of a process have one size; give them as periodic errors instead")
        self._check_transfer()

    def _check_transfer(self) -> None:
        if isinstance(self.transfer, lti.StateSpace):
            slowest = float(np.max(np.linalg.eigvals(self.transfer.A).real, initial=-math.inf))
            if self.transfer.B.shape[1] != 1 or slowest >= 0.0:
                why = f"has a pole of {slowest:g} rad/s" if slowest >= 0.0 else f"has {self.transfer.B.shape[1]} inputs"
                raise ValueError(f"{self.name}: its transfer {why}; give a stable system of one input")
            if self.apart:
                raise ValueError(f"{self.name}: errors apart by axis need gains; give a source for each axis instead")
            return
        gains = np.asarray(self.transfer, dtype=float)
        if gains.ndim != 1 or not gains.size:
            raise ValueError(f"{self.name}: its gains have the shape {gains.shape}; give a finite one for each axis")
        if not np.isfinite(gains).all():
            raise ValueError(f"{self.name}: its gains are {gains.tolist()}; give a finite one for each axis")

    @property
    def axes(self) -> int:
        """Number of axes that it reaches."""
        return self.transfer.C.shape[0] if isinstance(self.transfer, lti.StateSpace) else len(self.transfer)

    @property
    def by_axis(self) -> tuple["ErrorSource", ...]:
        """The same as errors that have nothing to do with each other: one for each axis where they are apart."""
        if not self.apart:
            return (self,)
        gains = np.diag(np.asarray(self.transfer, dtype=float))
        return tuple(replace(self, transfer=each, apart=False) for each in gains)

    @cached_property
    def motion(self) -> Motion:
        """The stationary motion of a process about each axis, at size 1."""
        assert self.process is not None
        return motion_behind(self.process, self.transfer)

    def response(self, freq_hz: float) -> Complexes:
        """Complex gain to each axis at a frequency, shape (axes,)."""
        if isinstance(self.transfer, lti.StateSpace):
            return lti.frequency_response(self.transfer, np.array([freq_hz]))[0, :, 0]
        return np.asarray(self.transfer, dtype=complex)

    def at_rest(self) -> Floats:
        """Gain to each axis of what does not change, shape (axes,)."""
        if not isinstance(self.transfer, lti.StateSpace):
            return np.asarray(self.transfer, dtype=float)
        A, B, C, D = self.transfer.A, self.transfer.B, self.transfer.C, self.transfer.D
        return np.asarray((D - C @ np.linalg.solve(A, B))[:, 0] if A.size else D[:, 0])
