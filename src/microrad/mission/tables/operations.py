"""The tables of a mission about its operations: what is to be delivered, by which ways, and to whom else."""

import math
from collections.abc import Iterator
from typing import Annotated, Literal

from pydantic import Field

from microrad.core.units import format_input
from microrad.mission.fields import Monthly, Problem, Quantity, Several, Table, Whole
from microrad.mission.tables.mirror import Name
from microrad.mission.tables.orbit import HIGHEST_MASK_RAD, Seconds

DataRate = Annotated[float, Quantity("bit/s", "Mbit/s", above=0.0)]
Availability = Annotated[tuple[float, ...], Monthly(Quantity("", least=0.0, most=1.0))]
Longitude = Annotated[float, Quantity("rad", "deg", least=-math.pi, most=2.0 * math.pi)]
MOST_SITES = 100
"""Stations of an optical network; the work grows as the square of their number."""


class StationTable(Table):
    """A ground station of the direct downlink."""

    latitude_rad: Annotated[float, Quantity("rad", "deg", least=-math.pi / 2, most=math.pi / 2)] = Field(
        description="geodetic, north positive"
    )
    longitude_rad: Longitude = Field(description="east positive")
    height_m: Annotated[float, Quantity("m", "m", least=-500.0, most=9000.0)] = Field(description="above the ellipsoid")
    mask_rad: Annotated[float, Quantity("rad", "deg", least=0.0, most=HIGHEST_MASK_RAD)] = Field(
        description="lowest elevation at which data flow"
    )


class Downlink(Table):
    """The radio downlink that the relay is set against: one station at a time."""

    data_rate_bit_s: DataRate = Field(description="from the partner to the ground")
    setup_s: Seconds = Field(description="from the rise above the mask until data flow")
    delay_s: Seconds = Field(description="from the station to the user")
    stations: dict[str, StationTable] = Field(description="one table for each, [operations.downlink.stations.NAME]")

    def __hash__(self) -> int:
        """Of what is in it, in its order."""
        return hash((self.data_rate_bit_s, self.setup_s, self.delay_s, tuple(self.stations.items())))

    def problems(self) -> Iterator[Problem]:
        """At least one station."""
        if not self.stations:
            yield Problem("stations", "holds no station", "a table such as [operations.downlink.stations.kiruna]")


class OpticalStationTable(StationTable):
    """A ground station with a telescope, of the optical downlink."""

    availability: Availability = Field(description="share of the time without clouds, one number or twelve by month")


class OpticalDownlink(Table):
    """The optical downlink that the relay is set against: one station at a time, of those without clouds."""

    data_rate_bit_s: DataRate = Field(description="from the satellite to the ground, above the mask of a clear station")
    setup_s: Seconds = Field(description="from when a station takes over until data flow")
    delay_s: Seconds = Field(description="from the station to the user")
    weather_s: Annotated[float, Quantity("s", "h", above=0.0, most=31536000.0)] = Field(
        description="how long clouds or a clear sky last: they are drawn anew after each such time"
    )
    correlation_length_m: Annotated[float, Quantity("m", "km", least=0.0, most=1e8)] = Field(
        description="of clouds: two sites are correlated by exp(-distance / length); 0 km: independent"
    )
    stations: dict[str, OpticalStationTable] = Field(
        description="one table for each, [operations.optical.stations.NAME]"
    )

    def __hash__(self) -> int:
        """Of what is in it, in its order."""
        own = (getattr(self, name) for name in type(self).model_fields if name != "stations")
        return hash((*own, tuple(self.stations.items())))

    def problems(self) -> Iterator[Problem]:
        """At least one station, and no more than a joint distribution is made for."""
        if not self.stations:
            yield Problem("stations", "holds no station", "a table such as [operations.optical.stations.tenerife]")
        if len(self.stations) > MOST_SITES:
            yield Problem("stations", f"holds {len(self.stations)} stations", f"at most {MOST_SITES}")


class ContactTable(Table):
    """One contact as a run in time, with the fine-pointing loop in sampled windows."""

    number: Annotated[int, Whole("", least=1, most=100_000)] = Field(description="which contact of the span, from 1")
    slew_rate_rad_s: Annotated[float, Quantity("rad/s", "deg/s", above=0.0)] = Field(
        description="of the body, towards the partner before the contact"
    )
    slew_angle_rad: Annotated[float, Quantity("rad", "deg", least=0.0, most=math.pi)] = Field(
        description="how far it turns"
    )
    windows: Annotated[int, Whole("", least=1, most=1000)] = Field(
        description="pieces of the contact that the fine-pointing loop is simulated in"
    )
    window_s: Annotated[float, Quantity("s", "s", above=0.0, most=1000.0)] = Field(description="length of such a piece")
    hold_s: Seconds = Field(description="how long the margin may stay below 0 dB before lock is taken for lost")

    def problems(self) -> Iterator[Problem]:
        """A loss that a window can show."""
        if self.hold_s >= self.window_s:
            shown = format_input(self.window_s, "s")
            yield Problem("hold", f"is not below window ({shown}): a window would never show a loss", f"below {shown}")


class Operations(Table):
    """From contacts to delivered data."""

    instrument_rate_bit_s: DataRate = Field(description="what fills the store, on average")
    store_bit: Annotated[float, Quantity("bit", "GB", above=0.0)] = Field(description="capacity")
    rates_bit_s: Annotated[tuple[float, ...], Several(Quantity("bit/s", "Mbit/s", above=0.0), rising=True)] | None = (
        Field(default=None, description="stepped with range; absent: communication.data_rate alone")
    )
    margin_db: Annotated[float, Quantity("dB", least=0.0)] = Field(
        description="of the laser link, at which a data rate counts as one that it closes at"
    )
    acquisition: Literal["wide beacon", "scan"] = Field(description="by which the partner is found")
    relay_share: Annotated[float, Quantity("", least=0.01, most=1.0)] = Field(
        description="share of each contact that the relay grants, from its beginning"
    )
    relay_delay_s: Seconds = Field(description="from the satellite's laser to the user")
    runs: Annotated[int, Whole("", least=1, most=10_000)] = Field(
        description="of the span, each with acquisitions drawn"
    )
    seed: Annotated[int, Whole("", least=0, most=2**63 - 1)] = Field(
        description="of the random numbers of acquisitions, outages and weather"
    )
    downlink: Downlink | None = None
    optical: OpticalDownlink | None = None
    contact: ContactTable | None = None


class RelayTable(Table):
    """A relay of the constellation."""

    longitude_rad: Longitude = Field(description="of its slot, east positive")


class SharedStationTable(StationTable):
    """A ground station that the satellites of the constellation share beside the relays."""

    data_rate_bit_s: DataRate = Field(description="from a satellite to the ground, above the mask")
    terminals: Annotated[int, Whole("", least=1, most=100)] = Field(
        description="of this station, each serves one satellite at a time"
    )
    availability: Availability = Field(
        description="share of the time in which it can be used, one number or twelve by month; a factor on its volumes"
    )


class Constellation(Table):
    """Many satellites that share some relays and ground stations."""

    pattern: Literal["delta", "star", "file"] = Field(
        description="delta, star: Walker's patterns around orbit.leo (circular or keplerian), nodes over 360 or "
        "180 deg; file: element sets"
    )
    satellites: Annotated[int, Whole("", least=1, most=100_000)] | None = Field(
        default=None, description="how many of them"
    )
    planes: Annotated[int, Whole("", least=1, most=100_000)] | None = Field(
        default=None, description="orbital planes that they are spread over"
    )
    phasing: Annotated[int, Whole("", least=0, most=100_000)] | None = Field(
        default=None, description="Walker's F, of planes"
    )
    file: Name | None = Field(default=None, description="TLEs or OMMs, seen from the mission file")
    terminals: Annotated[int, Whole("", least=1, most=100)] = Field(
        description="of each relay, each serves one satellite at a time"
    )
    overhead_s: Seconds = Field(description="of each session before data flow")
    session_s: Annotated[float, Quantity("s", "s", above=0.0, most=1e6)] = Field(
        description="longest, while others wait"
    )
    shortest_s: Seconds = Field(description="session that is worth its overhead")
    relays: dict[str, RelayTable] = Field(description="one table for each, [constellation.relays.NAME]")
    stations: dict[str, SharedStationTable] = Field(
        default={}, description="one table for each, [constellation.stations.NAME]; none: relays alone"
    )

    def __hash__(self) -> int:
        """Of what is in it, in its order."""
        own = (getattr(self, name) for name in type(self).model_fields if name not in ("relays", "stations"))
        return hash((*own, tuple(self.relays.items()), tuple(self.stations.items())))

    def problems(self) -> Iterator[Problem]:
        """The keys of the pattern, and no others; planes that divide the satellites."""
        from_file = self.pattern == "file"
        needed = {"file": '"satellites.tle"'} if from_file else {"satellites": "1", "planes": "1", "phasing": "0"}
        yield from self.choice_problems(f'pattern = "{self.pattern}"', needed, ("stations",))
        if self.satellites and self.planes and self.satellites % self.planes:
            yield Problem("planes", f"does not divide satellites = {self.satellites}", "a divisor of it")
        if self.planes and self.phasing is not None and self.phasing >= self.planes:
            expected = f"0 to {self.planes - 1}" if self.planes > 1 else "0"
            yield Problem("phasing", f"is not below planes = {self.planes}", expected)
        if self.shortest_s <= self.overhead_s:
            reason = "is not above overhead: such a session would carry no data"
            yield Problem("shortest", reason, f"more than {format_input(self.overhead_s, 's')}")
        if self.session_s < self.shortest_s:
            yield Problem("session", "is below shortest", f"at least {format_input(self.shortest_s, 's')}")
        if not self.relays:
            yield Problem("relays", "holds no relay", "a table such as [constellation.relays.east]")
        for name in self.stations:
            if name in self.relays:
                yield Problem(f"stations.{name}", "is the name of a relay, too", "a name of its own")
