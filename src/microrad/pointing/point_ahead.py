"""Point-ahead: the angle between where the partner is seen and where it will be when the light arrives."""

from dataclasses import dataclass

from microrad.pointing.classes import StatedError
from microrad.pointing_table import PointAhead
from microrad.units import SPEED_OF_LIGHT_M_S, format_quantity

NAME = "Point-ahead"
"""What the budget calls its line."""
MOST_VELOCITY_M_S = 0.01 * SPEED_OF_LIGHT_M_S
"""Velocity up to which 2 v / c holds to a part in ten thousand."""


@dataclass(frozen=True, slots=True)
class PointAheadAngle:
    """The point-ahead angle of a mission, and what the budget has to carry of it.

    `error_rad` is what the correction leaves, radial, or the whole angle about one axis when `corrected` is false.
    """

    angle_rad: float
    corrected: bool
    error_rad: float

    @property
    def stated(self) -> StatedError:
        """The line of the budget: a constant error, and its largest value."""
        return StatedError(NAME, self.error_rad, "bias", "bound", "radial" if self.corrected else "x")

    @property
    def basis(self) -> str:
        """How the line comes about."""
        shown = format_quantity(self.angle_rad, "rad", 3)
        return f"what correcting {shown} leaves" if self.corrected else f"2 v / c = {shown}, not corrected"


def point_ahead_rad(transverse_velocity_m_s: float) -> float:
    """2 v / c for the velocity of one terminal against the other across the line of sight.

    71 µrad for 10.65 km/s. Raises `ValueError` for a negative velocity and above 1 % of the speed of light.
    """
    if not 0.0 <= transverse_velocity_m_s <= MOST_VELOCITY_M_S:
        limit = format_quantity(MOST_VELOCITY_M_S, "m/s")
        shown = format_quantity(transverse_velocity_m_s, "m/s")
        raise ValueError(f"a transverse velocity of {shown} is out of range; give 0 m/s to {limit}")
    return 2.0 * transverse_velocity_m_s / SPEED_OF_LIGHT_M_S


def point_ahead(table: PointAhead) -> PointAheadAngle:
    """The angle of a mission and what is left of it."""
    angle = point_ahead_rad(table.transverse_velocity_m_s)
    return PointAheadAngle(angle, table.corrected, table.error_rad if table.corrected else angle)
