"""What every orbit gives, and the errors of this room.

The inertial frame is TEME (true equator, mean equinox of date), the frame of SGP4. The frame fixed in the Earth is TEME
turned about z by Greenwich mean sidereal time (IAU 1982) at UT1; polar motion (at most 0.6 arcsec) is neglected.
Times are elapsed seconds since the epoch of the mission. Vectors are axis first: shape (3, n) for n times.
"""

from typing import NamedTuple, Protocol, TypeVar

from microrad.core.arrays import Floats
from microrad.core.errors import MicroradError
from microrad.mission import fields


class OrbitError(MicroradError):
    """An orbit, an instant or a place is not possible; the message says why, and what to do."""

    page = "day"


class Bounded(fields.Bounded):
    """A record of this room that refuses what its annotations do not allow; raises OrbitError."""

    __slots__ = ()
    REFUSAL = OrbitError


class OperationsError(MicroradError):
    """A table, a rate or a plan of the day is not possible; the message says which value, and what to give."""

    page = "day"


_Table = TypeVar("_Table")


def required(table: _Table | None, name: str, error: type[ValueError]) -> _Table:
    """A table of the mission that has to be there.

    Args:
        table: The table; None where the mission has none.
        name: What the table is called in the mission file.
        error: The error to raise without it.

    Raises:
        ValueError: The error that was given, where there is no table.
    """
    if table is None:
        raise error(f"the mission has no table [{name}]: microrad init writes one")
    return table


class States(NamedTuple):
    """Position and velocity in TEME, of shape (3, n) each; shape (3,) for a single time."""

    position_m: Floats
    velocity_m_s: Floats


class Orbit(Protocol):
    """Anything that moves by a rule: a Kepler orbit, an element set, a table of positions."""

    @property
    def name(self) -> str:
        """What the satellite is called in tables and messages."""
        ...

    def states(self, time_s: Floats) -> States:
        """States at `time_s`, elapsed seconds since the epoch of the mission, in any order.

        Raises:
            OrbitError: For a time at which the rule does not hold.
        """
        ...
