"""The tables of a mission about its orbits: where both terminals fly, and what lets them see each other."""

import math
import re
from collections.abc import Iterator
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Annotated, Any, Literal

from pydantic import Field, GetJsonSchemaHandler
from pydantic_core import CoreSchema

from microrad.core.units import UnitError
from microrad.mission.fields import OrWord, Problem, Quantity, Several, Switch, Table
from microrad.mission.tables.channel import LOWEST_ELEVATION_RAD
from microrad.mission.tables.mirror import Name

HIGHEST_MASK_RAD = math.radians(89.0)
"""Mask above which hardly a pass is left: a satellite would have to cross the zenith."""
SUN_SYNCHRONOUS = "sun-synchronous"
"""What a mission writes for the inclination at which the node follows the Sun."""
LONGEST_S = 400.0 * 86400.0

_EPOCH = re.compile(r"\d{4}-\d{2}-\d{2}T\d{2}:\d{2}(:\d{2}(\.\d{1,6})?)?Z")

Anomaly = Annotated[float, Quantity("rad", "deg", least=-2.0 * math.pi, most=2.0 * math.pi)]
HalfAngle = Annotated[float, Quantity("rad", "deg", above=0.0, most=math.pi)]
_INCLINATION = OrWord("rad", "deg", least=0.0, most=math.pi, word=SUN_SYNCHRONOUS, stands_for=SUN_SYNCHRONOUS)
Seconds = Annotated[float, Quantity("s", "s", least=0.0, most=1e6)]


@dataclass(frozen=True, slots=True)
class UtcEpoch(Quantity):
    """A date and time in UTC, kept as its text; TOML's own dates are taken too."""

    def read(self, value: object) -> str:  # type: ignore[override]
        """The text; raises `UnitError` for what is no date, or does not say that it is UTC."""
        if isinstance(value, datetime) and value.tzinfo is not None:
            try:
                return value.astimezone(UTC).isoformat().replace("+00:00", "Z")
            except OverflowError:
                raise UnitError(str(value), "is no date in UTC", self.wanted, self.example) from None
        if not isinstance(value, str) or not _EPOCH.fullmatch(value):
            shown = value if isinstance(value, str) else str(value)
            raise UnitError(shown, "is not a date and time with a Z for UTC", self.wanted, self.example)
        try:
            datetime.fromisoformat(value.removesuffix("Z"))
        except ValueError as error:
            raise UnitError(value, f"is no date: {error}", self.wanted, self.example) from None
        return value

    @property
    def example(self) -> str:
        """A date within the bounds."""
        return "2026-03-20T12:00:00Z"

    @property
    def wanted(self) -> str:
        """What the key expects, in words."""
        return "a date and time in UTC"

    def __get_pydantic_json_schema__(self, schema: CoreSchema, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        """Text with its pattern for an editor."""
        return {"type": "string", "pattern": f"^{_EPOCH.pattern}$", "examples": [self.example]}


class VisibilityLimits(Table):
    """What a terminal and its body can point at."""

    attitude: Literal["nadir", "sun", "free"] = Field(
        description="nadir: z to the Earth's centre, x along the flight; sun: x to the Sun, z as near to nadir as "
        "possible; free: the body turns the terminal to its partner"
    )
    boresight: Annotated[tuple[float, ...], Several(Quantity("", least=-1.0, most=1.0))] | None = Field(
        default=None, description="of the terminal in the body's axes x, y, z; nadir and sun need it"
    )
    field_of_regard_rad: HalfAngle | None = Field(
        default=None, description="half angle about the boresight; nadir and sun need it"
    )
    slew_limit_rad_s: Annotated[float, Quantity("rad/s", "deg/s", above=0.0)] = Field(
        description="largest rate of the line of sight, in the frame of the attitude"
    )
    sun_exclusion_rad: Annotated[float, Quantity("rad", "deg", least=0.0, most=math.pi / 2)] = Field(
        description='least angle between line of sight and a Sun that is not set; "0 deg": none'
    )
    in_eclipse: Annotated[bool, Switch("")] = Field(description="false: the terminal is off in the Earth's shadow")

    def problems(self) -> Iterator[Problem]:
        """A boresight and a field of regard exactly where the body does not turn."""
        if self.attitude == "free":
            yield from self.choice_problems('attitude = "free": the body turns', {})
        else:
            needed = {"boresight": "[0.0, 0.0, -1.0]", "field_of_regard": '"70 deg"'}
            yield from self.choice_problems(f'attitude = "{self.attitude}"', needed)
        if self.boresight is not None and len(self.boresight) != 3:
            yield Problem("boresight", f"has {len(self.boresight)} items", "three: boresight = [0.0, 0.0, -1.0]")
        elif self.boresight is not None and math.hypot(*self.boresight) < 0.1:
            yield Problem("boresight", "has no direction", "one such as boresight = [0.0, 0.0, -1.0]")


_NEEDS: dict[str, dict[str, str]] = {
    "circular": {"altitude": '"500 km"', "inclination": '"97.4 deg"', "phase": '"0 deg"', "gravity": '"j2"'},
    "keplerian": {
        "semi_major_axis": '"7000 km"',
        "eccentricity": "0.001",
        "inclination": '"97.4 deg"',
        "argument_of_perigee": '"90 deg"',
        "mean_anomaly": '"0 deg"',
        "gravity": '"j2"',
    },
    "elements": {"file": '"satellite.tle"'},
    "ephemeris": {"file": '"satellite.oem"'},
    "geostationary": {"longitude": '"143 deg"'},
    "station": {"latitude": '"28.3 deg"', "longitude": '"-16.5 deg"', "height": '"2400 m"', "mask": '"20 deg"'},
}
"""The keys that each kind of orbit needs, with a value that could stand there."""
_MAY_HAVE: dict[str, tuple[str, ...]] = {
    "circular": ("node", "local_time"),
    "keplerian": ("node", "local_time"),
    "elements": ("object",),
    "ephemeris": ("object",),
    "geostationary": (),
    "station": (),
}


class OrbitTable(Table):
    """The orbit of one terminal."""

    kind: Literal["circular", "keplerian", "elements", "ephemeris", "geostationary", "station"] = Field(
        description="elements: a TLE or an OMM, by SGP4; ephemeris: a CCSDS OEM; station: on the ground"
    )
    altitude_m: Annotated[float, Quantity("m", "km", least=1e5, most=1e9)] | None = Field(
        default=None, description="above the equatorial radius of 6378.137 km"
    )
    semi_major_axis_m: Annotated[float, Quantity("m", "km", least=6.4e6, most=1e9)] | None = Field(
        default=None, description="half of the orbit's longest diameter"
    )
    eccentricity: Annotated[float, Quantity("", least=0.0, most=0.999)] | None = Field(
        default=None, description="0 is a circle"
    )
    inclination_rad: Annotated[float | str, _INCLINATION] | None = Field(
        default=None, description=f'"{SUN_SYNCHRONOUS}": the node follows the Sun'
    )
    node_rad: Anomaly | None = Field(default=None, description="right ascension of the ascending node at the epoch")
    local_time_s: Annotated[float, Quantity("s", "h", least=0.0, most=86400.0)] | None = Field(
        default=None, description="mean local time of the ascending node, in place of node"
    )
    argument_of_perigee_rad: Anomaly | None = Field(
        default=None, description="from the ascending node to the perigee, along the orbit"
    )
    mean_anomaly_rad: Anomaly | None = Field(default=None, description="at the epoch")
    phase_rad: Anomaly | None = Field(default=None, description="angle from the ascending node at the epoch")
    gravity: Literal["two-body", "j2"] | None = Field(
        default=None, description="j2: node, perigee and anomaly drift as the Earth's flattening has it"
    )
    longitude_rad: Annotated[float, Quantity("rad", "deg", least=-math.pi, most=2.0 * math.pi)] | None = Field(
        default=None, description="of the slot or the station, east of Greenwich"
    )
    latitude_rad: Annotated[float, Quantity("rad", "deg", least=-math.pi / 2, most=math.pi / 2)] | None = Field(
        default=None, description="of the station, geodetic, north positive"
    )
    height_m: Annotated[float, Quantity("m", "m", least=-500.0, most=9000.0)] | None = Field(
        default=None, description="of the station above the ellipsoid"
    )
    mask_rad: Annotated[float, Quantity("rad", "deg", least=LOWEST_ELEVATION_RAD, most=HIGHEST_MASK_RAD)] | None = (
        Field(default=None, description="lowest elevation at which the link is used, and at which it is budgeted")
    )
    file: Name | None = Field(default=None, description="seen from the mission file")
    object: Name | None = Field(default=None, description="which satellite of the file; not needed where it has one")
    limits: VisibilityLimits | None = Field(default=None, description="absent: the terminal points anywhere")

    def problems(self) -> Iterator[Problem]:
        """The keys of the kind of orbit, and no others."""
        yield from self.choice_problems(f'kind = "{self.kind}"', _NEEDS[self.kind], (*_MAY_HAVE[self.kind], "limits"))
        if self.kind == "station" and self.limits is not None and self.limits.attitude != "free":
            yield Problem("limits.attitude", f'is "{self.limits.attitude}", and a station has none', '"free"')
        if "node" not in _MAY_HAVE[self.kind]:
            return
        if self.inclination_rad == SUN_SYNCHRONOUS and self.gravity == "two-body":
            reason = f'is "two-body", in which no node follows the Sun, and inclination is "{SUN_SYNCHRONOUS}"'
            yield Problem("gravity", reason, 'gravity = "j2", or an inclination in degrees')
        if self.node_rad is None and self.local_time_s is None:
            yield Problem(
                "node", "is missing, and so is local_time", 'node = "0 deg" or local_time = "10.5 h" would do'
            )
        if self.node_rad is not None and self.local_time_s is not None:
            yield Problem("node", "stands beside local_time", "one of the two removed")


class Orbits(Table):
    """Where both terminals fly, and the span of time that is looked at."""

    epoch: Annotated[str, UtcEpoch("")] = Field(description="beginning of the span, UTC")
    duration_s: Annotated[float, Quantity("s", "h", least=60.0, most=LONGEST_S)] = Field(
        description="how long the satellites are followed"
    )
    earth: Literal["oblate", "sphere"] = Field(
        description="what hides the partner: the ellipsoid of WGS 84, or a sphere of its equatorial radius"
    )
    grazing_height_m: Annotated[float, Quantity("m", "km", least=0.0, most=1e6)] = Field(
        description="least height of the line of sight above the Earth"
    )
    leo: OrbitTable
    geo: OrbitTable

    @property
    def station(self) -> str:
        """Which terminal stands on the ground, "leo" or "geo"; "" where both fly."""
        return next((end for end in ("leo", "geo") if getattr(self, end).kind == "station"), "")

    def problems(self) -> Iterator[Problem]:
        """At most one terminal on the ground."""
        if self.leo.kind == self.geo.kind == "station":
            yield Problem(
                "geo.kind", 'is "station", as is leo.kind: one of the two has to fly', "another kind of orbit"
            )
