"""The passes of a satellite over several ground stations, solved together: for many satellites over the same ones."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from microrad.core.arrays import Floats
from microrad.core.earth import place_m
from microrad.orbit.base import Orbit
from microrad.orbit.earth.epoch import Epoch
from microrad.orbit.earth.figure import Station
from microrad.orbit.visibility.contacts import Span, coarse_times
from microrad.orbit.visibility.events import Intervals, Rows, intersection, positive_rows


@dataclass(frozen=True, slots=True, eq=False)
class StationRows:
    """Stations as arrays of shape (stations,), each a row: their place in the turning Earth, direction up, mask."""

    epoch: Epoch
    longitude_rad: Floats
    across_m: Floats
    along_axis_m: Floats
    level: Floats
    rise: Floats
    mask_rad: Floats

    @classmethod
    def of(cls, stations: Sequence[Station], epoch: Epoch) -> "StationRows":
        """The rows of stations, by the formulas of `Station.position` and `Station.vertical`.

        Args:
            stations: The stations.
            epoch: Instant from which times count.
        """
        latitude, longitude, height, mask = np.array(
            [(s.latitude_rad, s.longitude_rad, s.height_m, s.mask_rad) for s in stations], dtype=np.float64
        ).T.reshape(4, -1)
        across, along = np.array([place_m(*each) for each in zip(latitude, height, strict=True)]).reshape(-1, 2).T
        return cls(epoch, longitude, across, along, np.cos(latitude), np.sin(latitude), mask)

    def lines(self, rotation_rad: Floats, row: Rows, position_m: Floats) -> tuple[Floats, Floats]:
        """Rise over the horizon and distance along it, m, both of the shape of the times and rows that are given.

        Args:
            rotation_rad: Angle of the Earth, `Epoch.earth_rotation_rad`.
            row: Number of the station.
            position_m: Positions in TEME, m, axis first.
        """
        angle = rotation_rad + self.longitude_rad[row]
        cosine, sine, across = np.cos(angle), np.sin(angle), self.across_m[row]
        x, y, z = position_m[0] - across * cosine, position_m[1] - across * sine, position_m[2] - self.along_axis_m[row]
        up_x, up_y, up_z = self.level[row] * cosine, self.level[row] * sine, self.rise[row]
        rise = (x * up_x + y * up_y) + z * up_z
        off_x, off_y, off_z = x - rise * up_x, y - rise * up_y, z - rise * up_z
        return rise, np.sqrt((off_x * off_x + off_y * off_y) + off_z * off_z)


def pass_spans(
    satellite: Orbit,
    stations: StationRows,
    span_s: Span,
    step_s: float,
    furthest_m: Sequence[float] = (),
) -> tuple[Intervals, ...]:
    """When a satellite is above the mask of each station, and within a range: the spans of `passes`, for all at once.

    Args:
        satellite: Orbit of the satellite.
        stations: The stations.
        span_s: Start and end of the search, s.
        step_s: Step of the samples, `coarse_step_s` of the orbit.
        furthest_m: Largest range for each station, m; infinite without a limit, as without any of them.

    Raises:
        OrbitError: If the span holds no time, or the orbit does not hold over it.
    """
    count = stations.mask_rad.size
    if not count:
        return ()
    time_s = coarse_times(span_s, step_s)
    every = np.broadcast_to(np.arange(count)[:, None], (count, time_s.size))
    rise, along = stations.lines(stations.epoch.earth_rotation_rad(time_s), every, satellite.states(time_s).position_m)
    limits = np.array(furthest_m or [math.inf] * count)

    def at(time: Floats, row: Rows) -> tuple[Floats, Floats]:
        return stations.lines(stations.epoch.earth_rotation_rad(time), row, satellite.states(time).position_m)

    def over_mask(time: Floats, row: Rows) -> Floats:
        return np.asarray(np.arctan2(*at(time, row)) - stations.mask_rad[row])

    seen = positive_rows(over_mask, time_s, np.arctan2(rise, along) - stations.mask_rad[:, None])
    if not np.any(limits < math.inf):
        return seen

    def within(time: Floats, row: Rows) -> Floats:
        up, off = at(time, row)
        return np.asarray(1.0 - (up * up + off * off) / limits[row] ** 2)

    near = positive_rows(within, time_s, 1.0 - (rise * rise + along * along) / limits[:, None] ** 2)
    return tuple(intersection(*both) for both in zip(seen, near, strict=True))
