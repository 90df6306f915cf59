"""Inputs and results of one contact in the time domain: its states, settings, windows and log."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum
from itertools import pairwise
from typing import Literal, NamedTuple

import numpy as np

from microrad.core.arrays import Floats
from microrad.core.units import format_quantity


class State(StrEnum):
    """What a terminal does in a contact, in the order in which it comes to it."""

    IDLE = "idle"
    SLEW = "slew"
    BEACON = "beacon"
    DETECT = "detect"
    ANSWER = "answer"
    LOCK = "lock"
    DATA = "data"
    LOSS = "loss"
    REACQUIRE = "re-acquire"
    END = "end"


STATES = tuple(state for state in State if state not in (State.IDLE, State.END))
"""The states that last."""

_MOST_WINDOWS = 100_000
_MOST_SEED = 2**63 - 1


class Sight(NamedTuple):
    """The line of sight to the partner at some times, each array as long as they are.

    Range, size of its angular rate, and point-ahead 2 v / c, which lies along the rate.
    """

    range_m: Floats
    rate_rad_s: Floats
    point_ahead_rad: Floats


Geometry = Callable[[Floats], Sight]
"""The line of sight at times (s) since the mission's epoch."""


@dataclass(frozen=True, slots=True)
class Contact:
    """When the partner is in sight, why it begins and ends, and its geometry; times since the mission's epoch.

    Before ``free_from_s`` the body cannot turn to the partner: the begin of the span or the end of the contact before.
    Raises ValueError for times that do not follow each other.
    """

    start_s: float
    end_s: float
    begins: str
    ends: str
    free_from_s: float
    geometry: Geometry

    def __post_init__(self) -> None:
        """Raises ValueError if the times do not follow one another."""
        if not -math.inf < self.start_s < self.end_s < math.inf:
            raise ValueError(
                f"a contact from {self.start_s:g} s to {self.end_s:g} s has no length: its end must be finite and "
                "come after its begin"
            )
        if not -math.inf < self.free_from_s <= self.start_s:
            raise ValueError(
                f"free_from_s is {self.free_from_s:g} s, and the contact begins at {self.start_s:g} s: it must be "
                "finite and no later; where the body is busy for longer, let the contact begin later"
            )

    def sight(self, time_s: Floats) -> Sight:
        """The line of sight at these times. Raises ValueError if the geometry gives another shape or no number."""
        found = Sight(*(np.asarray(values, dtype=float) for values in self.geometry(time_s)))
        for name, values, least in zip(Sight._fields, found, ("above", "at least", "at least"), strict=True):
            if values.shape != np.shape(time_s):
                raise ValueError(
                    f"the geometry gives {name} with the shape {values.shape} for times of {np.shape(time_s)}"
                )
            good = np.isfinite(values) & ((values > 0.0) if least == "above" else (values >= 0.0))
            if not np.all(good):
                at = int(np.argmin(good))
                raise ValueError(
                    f"the geometry gives {name} = {values[at]:g} at {time_s[at]:.3f} s, which must be finite and "
                    f"{least} 0: is that time within what the orbits cover?"
                )
        return found


@dataclass(frozen=True, slots=True)
class Settings:
    """How a contact is run.

    The body turns by ``slew_angle_rad`` before the contact, at ``slew_rate_rad_s``. The fine loop is simulated in
    ``windows`` windows of ``window_s`` each, the first right behind lock and the last right before the end, settled for
    ``settle_s`` before it. Lock is lost where the received power stays below the receiver's threshold for longer than
    ``hold_s``. ``way`` is how the partner is found, and ``attempts`` are the acquisitions, or losses in windows that
    follow each other, behind which it is given up.

    Raises ValueError for a value without meaning.
    """

    slew_angle_rad: float
    slew_rate_rad_s: float
    windows: int
    window_s: float
    settle_s: float
    hold_s: float
    seed: int
    attempts: int
    way: Literal["wide beacon", "scan"] = "wide beacon"

    def __post_init__(self) -> None:
        """Raises ValueError if a value is out of range."""
        _limit("slew_angle_rad", self.slew_angle_rad, 0.0 <= self.slew_angle_rad <= math.pi, "from 0 to pi rad")
        _limit("slew_rate_rad_s", self.slew_rate_rad_s, self.slew_rate_rad_s > 0.0, "above 0 rad/s")
        _limit("windows", self.windows, 1 <= self.windows <= _MOST_WINDOWS, f"from 1 to {_MOST_WINDOWS}")
        _limit("window_s", self.window_s, self.window_s > 0.0, "above 0 s")
        _limit("settle_s", self.settle_s, self.settle_s >= 0.0, "at least 0 s")
        window = format_quantity(self.window_s, "s")
        limit = f"at least 0 s and below window_s ({window}): a window shows no loss that takes longer"
        _limit("hold_s", self.hold_s, 0.0 <= self.hold_s < self.window_s, limit)
        _limit("seed", self.seed, 0 <= self.seed <= _MOST_SEED, "from 0 to 2^63 - 1")
        if self.way not in ("wide beacon", "scan"):
            raise ValueError(f'way of a contact run is "{self.way}": it must be "wide beacon" or "scan"')


def _limit(name: str, value: float, holds: bool, limit: str) -> None:
    if not (holds and math.isfinite(value)):
        raise ValueError(f"{name} of a contact run is {value:g}: it must be finite and {limit}")


@dataclass(frozen=True, slots=True)
class Transition:
    """One entry of the log: at ``time_s`` the terminal leaves ``state`` for ``to``, and why.

    A failure that is tried again in the same state leaves that state for itself.
    """

    time_s: float
    state: State
    to: State
    cause: str


@dataclass(frozen=True, slots=True)
class Loss:
    """Lock is lost at ``time_s``, from a cause that began at ``since_s``; the terminal knows of it at ``known_s``."""

    since_s: float
    time_s: float
    known_s: float
    cause: str


@dataclass(frozen=True, slots=True)
class Window:
    """The fine loop in one sampled window, up to the loss of lock where there is one.

    It lasts ``seconds``. Range, point-ahead and rate are those at its begin; the loop has them as its references.
    Errors are radial, at the control samples; a share of the time that the mission states stays below ``quantile_rad``.
    ``margin_db`` is that of the communication link at the error and range of the moment, ``share_below`` the share of
    the time with less than 0 dB.
    ``mirror_rad`` is the mean angle that the mirror gives the line of sight, by axis.
    """

    start_s: float
    seconds: float
    range_m: float
    point_ahead_rad: float
    rate_rad_s: float
    rms_rad: float
    quantile_rad: float
    largest_rad: float
    lowest_margin_db: float
    share_below: float
    mirror_rad: tuple[float, ...]
    loss: Loss | None
    time_s: Floats
    radial_rad: Floats
    margin_db: Floats


@dataclass(frozen=True, slots=True)
class ContactRun:
    """One contact: its log from the slew to the end, and the windows of its data phase, both in the order of time."""

    contact: Contact
    log: tuple[Transition, ...]
    windows: tuple[Window, ...]

    @property
    def seconds(self) -> dict[State, float]:
        """Time in each of `STATES`; a slew lies before the contact, as far as there is time."""
        spent: dict[State, float] = dict.fromkeys(STATES, 0.0)
        for entered, left in pairwise(self.log):
            spent[left.state] += left.time_s - entered.time_s
        return spent

    @property
    def data_s(self) -> float:
        """Time with data."""
        return self.seconds[State.DATA]

    @property
    def data_share(self) -> float:
        """Time with data over that of the contact."""
        return self.data_s / (self.contact.end_s - self.contact.start_s)

    @property
    def losses(self) -> int:
        """How often lock was lost in a window."""
        return sum(entry.to == State.LOSS for entry in self.log)

    @property
    def losses_per_s(self) -> float:
        """Losses over the time that was simulated; much above 1 / data_s, data between the windows is not to be had."""
        return self.losses / self.sampled_s if self.windows else 0.0

    @property
    def sampled_s(self) -> float:
        """Time with data that lies in windows."""
        return sum(w.seconds for w in self.windows)

    @property
    def first_data_s(self) -> float:
        """When data begins; nan where it never does."""
        return next((entry.time_s for entry in self.log if entry.to == State.DATA), math.nan)

    @property
    def share_below(self) -> float:
        """Share of the windows' time with less margin than 0 dB; 0 where the data is too short for a window."""
        below = sum(w.share_below * w.seconds for w in self.windows)
        return below / self.sampled_s if self.windows else 0.0

    def bits(self, data_rate_bit_s: float) -> float:
        """What arrives at a data rate: that of the time with data, less the share with less margin than 0 dB."""
        return data_rate_bit_s * self.data_s * (1.0 - self.share_below)
