"""Point-ahead: the angle between where the partner is seen and where it will be when the light arrives."""

from dataclasses import dataclass

from microrad.core.units import format_quantity
from microrad.link.pointing.error_classes import StatedError
from microrad.mission.tables.pointing import PointAhead, point_ahead_rad

NAME = "Point-ahead"
"""What the budget calls its line."""


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


def point_ahead(table: PointAhead) -> PointAheadAngle:
    """The angle of a mission and what is left of it."""
    angle = point_ahead_rad(table.transverse_velocity_m_s)
    return PointAheadAngle(angle, table.corrected, table.error_rad if table.corrected else angle)
