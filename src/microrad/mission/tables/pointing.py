"""The tables of a mission about its open-loop pointing: budget lines with their class, jitter, point-ahead."""

import math
from collections.abc import Iterator, Sequence
from typing import Annotated, Literal

from pydantic import Field

from microrad.core.units import SPEED_OF_LIGHT_M_S, counted, format_quantity
from microrad.mission.fields import Problem, Quantity, Several, Share, Switch, Table
from microrad.mission.tables.mirror import ANGLE_MOST, Frequency

AngleOrZero = Annotated[float, Quantity("rad", "urad", least=0.0, most=ANGLE_MOST)]
TwoAngles = Annotated[tuple[float, ...], Several(Quantity("rad", "urad", least=0.0, most=ANGLE_MOST))]
TwoOffsets = Annotated[tuple[float, ...], Several(Quantity("rad", "urad", least=-ANGLE_MOST, most=ANGLE_MOST))]

MOST_VELOCITY_M_S = 0.01 * SPEED_OF_LIGHT_M_S
"""Velocity up to which 2 v / c holds to a part in ten thousand."""

ErrorClass = Literal["bias", "random", "drift", "transient"]
Statistic = Literal["1-sigma", "2-sigma", "3-sigma", "bound"]


class PointingLine(Table):
    """One error of the open-loop pointing budget."""

    error_rad: AngleOrZero = Field(description="half width about the line of sight")
    kind: ErrorClass = Field(
        alias="class",
        description="bias: constant in time; random: about zero; drift: from zero, steadily; transient: now and then",
    )
    statistic: Statistic = Field(description='what the error is; "bound" is never exceeded')
    axes: Literal["per-axis", "radial"] = Field(
        description="per-axis: about each of two; radial: off the line of sight"
    )

    @property
    def per_axis_rad(self) -> float:
        """The error about one axis; a radial one is shared equally between two."""
        return self.error_rad / math.sqrt(2.0) if self.axes == "radial" else self.error_rad


class Pointing(Table):
    """Open-loop pointing: the errors that the beacon has to cover."""

    confidence: Annotated[float, Share("")] = Field(
        description="share of the time, of the worst-case satellite, that totals hold for and a beacon covers"
    )
    lines: dict[str, PointingLine] = Field(description="one table for each error, [pointing.lines.NAME]")

    def __hash__(self) -> int:
        """Of what is in it, in its order."""
        return hash((self.confidence, tuple(self.lines.items())))

    @property
    def bias_rad(self) -> float:
        """What never averages out, about one axis: the lines of class "bias", all in one direction."""
        return sum(line.per_axis_rad for line in self.lines.values() if line.kind == "bias")

    def problems(self) -> Iterator[Problem]:
        """At least one line."""
        if not self.lines:
            yield Problem("lines", "holds no error", "a table such as [pointing.lines.body_pointing]")


def two_axes_problems(**lists: tuple[Sequence[float], str]) -> Iterator[Problem]:
    """Lists that have not one value for each axis, by their keys, with what an item could be."""
    for key, (values, item) in lists.items():
        if len(values) != 2:
            yield Problem(key, f"has {counted(len(values), 'item')}", f'two, for x and y: {key} = ["{item}", "{item}"]')


class JitterTable(Table):
    """What fine pointing leaves, for a link that is budgeted without a simulated loop."""

    bias_rad: TwoOffsets = Field(description="static, about x and y")
    rms_rad: TwoAngles = Field(description="about the bias, about x and y")
    bandwidth_hz: Frequency = Field(description="root mean square frequency of the jitter: rms rate over 2 pi rms")

    def problems(self) -> Iterator[Problem]:
        """Two axes."""
        yield from two_axes_problems(bias=(self.bias_rad, "1 urad"), rms=(self.rms_rad, "1 urad"))


class PointAhead(Table):
    """The angle between where the partner is seen and where it will be when the light arrives."""

    transverse_velocity_m_s: Annotated[float, Quantity("m/s", "km/s", least=0.0, most=1e5)] = Field(
        description="largest, across the line of sight, of one terminal against the other"
    )
    corrected: Annotated[bool, Switch("")] = Field(description="false: both beams leave along the line of sight")
    error_rad: AngleOrZero = Field(description="what a correction leaves, radial")


def point_ahead_rad(transverse_velocity_m_s: float) -> float:
    """2 v / c for the velocity of one terminal against the other across the line of sight.

    71 µrad for 10.65 km/s. Raises `ValueError` for a negative velocity and above 1 % of the speed of light.
    """
    if not 0.0 <= transverse_velocity_m_s <= MOST_VELOCITY_M_S:
        limit = format_quantity(MOST_VELOCITY_M_S, "m/s")
        shown = format_quantity(transverse_velocity_m_s, "m/s")
        raise ValueError(f"a transverse velocity of {shown} is out of range; give 0 m/s to {limit}")
    return 2.0 * transverse_velocity_m_s / SPEED_OF_LIGHT_M_S
