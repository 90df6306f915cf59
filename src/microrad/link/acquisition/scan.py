"""Search of a disc of uncertainty by a narrow beam: the spiral, the raster and the step-and-stare pattern."""

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from microrad.core.arrays import Floats
from microrad.core.units import format_input, format_limit, format_quantity
from microrad.mission.fields import Bounded, Quantity, Share

OffAxis = Annotated[float, Share("rad", below=math.pi / 2), "an angle from the line of sight is meant"]
Overlap = Annotated[float, Share("", least=0.0), "a share of a diameter"]
Duration = Annotated[float, Quantity("s", above=0.0)]
DurationOrZero = Annotated[float, Quantity("s", least=0.0)]
Probability = Annotated[float, Quantity("", above=0.0, most=1.0)]
Speed = Annotated[float, Quantity("rad/s", above=0.0)]


@dataclass(frozen=True, slots=True)
class Search(Bounded):
    """What is searched and with which beam.

    The target lies at a Gaussian offset from the middle, `sigma_rad` in each axis. `beam_radius_rad` is the half angle
    within which the power suffices for detection, not the 1/e2 half angle. `overlap` is the share of the beam's
    diameter by which neighbouring tracks overlap. `coverage` is the probability that the target lies within the
    searched disc.
    """

    sigma_rad: Annotated[float, Quantity("rad", above=0.0)]
    beam_radius_rad: OffAxis
    overlap: Overlap
    coverage: Annotated[float, Share(""), "Gaussian errors have no edge"]

    def __post_init__(self) -> None:
        """Raises ValueError if an angle, the overlap or the coverage is out of its range."""
        Bounded.__post_init__(self)
        Share("rad", below=math.pi / 2).check("the radius that covers the pointing error", self.radius_rad)

    @property
    def radius_rad(self) -> float:
        """Radius of the searched disc: sigma sqrt(-2 ln(1 - P))."""
        return self.sigma_rad * math.sqrt(-2.0 * math.log1p(-self.coverage))

    @property
    def pitch_rad(self) -> float:
        """Distance of neighbouring tracks, 2 beam_radius (1 - overlap)."""
        return 2.0 * self.beam_radius_rad * (1.0 - self.overlap)


@dataclass(frozen=True, slots=True)
class Detector(Bounded):
    """The partner's detector: one look needs the beam for `detection_time_s` and detects with `probability`.

    A crossing that lasts n whole detection times is n looks, each independent: 1 - (1 - p)^n. A shorter one is none.
    """

    detection_time_s: Duration
    probability: Probability = 1.0

    def looks(self, duration_s: Floats) -> Floats:
        """Whole looks in a crossing of each duration."""
        return np.floor(duration_s / self.detection_time_s * (1.0 + 1e-9))

    def crossing_probability(self, duration_s: Floats) -> Floats:
        """Probability of detection in a crossing of each duration."""
        return np.asarray(1.0 - (1.0 - self.probability) ** self.looks(duration_s), dtype=np.float64)


@dataclass(frozen=True, slots=True)
class Spiral(Bounded):
    """Archimedean spiral from the middle outward at constant tangential speed: r = sqrt(pitch speed t / pi)."""

    search: Search
    detector: Detector
    speed_rad_s: Speed

    def __post_init__(self) -> None:
        """Raises ValueError if the beam leaves the target before it is detected."""
        Bounded.__post_init__(self)
        _check_speed(self.search, self.detector, self.speed_rad_s)

    @property
    def duration_s(self) -> float:
        """Time of one scan, pi R^2 / (pitch speed)."""
        return math.pi * self.search.radius_rad**2 / (self.search.pitch_rad * self.speed_rad_s)

    def track_radius(self, time_s: Floats) -> Floats:
        """Distance of the beam from the middle at each time."""
        return np.sqrt(self.search.pitch_rad * self.speed_rad_s * time_s / math.pi)

    def time_at(self, track_radius_rad: Floats) -> Floats:
        """Time at which the track has each radius; zero for a negative one."""
        return math.pi * np.maximum(track_radius_rad, 0.0) ** 2 / (self.search.pitch_rad * self.speed_rad_s)

    def beam_at(self, time_s: Floats, within_s: Floats) -> tuple[Floats, Floats]:
        """Beam's centre (x, y) at each time, in rad.

        Args:
            time_s: Times from the begin of the scan, in s, any shape.
            within_s: A time within the pass that is under way, in s, of the shape of the times; a spiral does not need
                it.
        """
        radius = self.track_radius(time_s)
        angle = 2.0 * math.pi * radius / self.search.pitch_rad
        return radius * np.cos(angle), radius * np.sin(angle)

    def windows(self, x_rad: Floats, y_rad: Floats, reach_rad: float) -> tuple[Floats, Floats]:
        """Start and end of the times when the beam may be near each target, in s, each of shape (targets, windows).

        Args:
            x_rad: Place of each target along x, in rad from the middle of the search, shape (targets,).
            y_rad: The same along y, shape (targets,).
            reach_rad: Distance from the beam's centre that counts as near, in rad.
        """
        pitch = self.search.pitch_rad
        radius, azimuth = np.hypot(x_rad, y_rad), np.arctan2(y_rad, x_rad) % (2.0 * math.pi)
        count = math.ceil(2.0 * reach_rad / pitch) + 2
        turns = azimuth / (2.0 * math.pi)
        first = np.ceil((radius - reach_rad) / pitch - turns) - 1.0
        middle = pitch * (turns[:, None] + first[:, None] + np.arange(count))  # track radius at the target's azimuth
        near = radius < 2.0 * reach_rad
        spread = np.arcsin(np.minimum(1.2 * reach_rad / np.maximum(radius, 2.0 * reach_rad), 1.0))
        half = (pitch * spread / (2.0 * math.pi))[:, None]
        start, end = self.time_at(middle - half), self.time_at(middle + half)
        last = self.time_at(radius + reach_rad + pitch)[:, None]
        slots = np.arange(count + 1) / count
        start = np.where(near[:, None], last * slots[:-1], start)
        end = np.where(near[:, None], last * slots[1:], end)
        return np.minimum(start, self.duration_s), np.minimum(end, self.duration_s)


@dataclass(frozen=True, slots=True)
class Raster(Bounded):
    """Rows of length 2R a pitch apart, to and fro, over the square around the disc.

    Between two rows passes `turn_around_s`, in which nothing is detected.
    """

    search: Search
    detector: Detector
    speed_rad_s: Speed
    turn_around_s: DurationOrZero = 0.0

    def __post_init__(self) -> None:
        """Raises ValueError if a time is negative, or the beam leaves the target before it is detected."""
        Bounded.__post_init__(self)
        _check_speed(self.search, self.detector, self.speed_rad_s)

    @property
    def rows(self) -> int:
        """Number of rows."""
        return math.ceil(2.0 * self.search.radius_rad / self.search.pitch_rad * (1.0 - 1e-12))

    @property
    def row_time_s(self) -> float:
        """Time along one row, without the turn."""
        return 2.0 * self.search.radius_rad / self.speed_rad_s

    @property
    def duration_s(self) -> float:
        """Time of one scan."""
        return self.rows * self.row_time_s + (self.rows - 1) * self.turn_around_s

    @property
    def row_rad(self) -> Floats:
        """Offset of each row from the middle, ascending: the order in which they are scanned."""
        return np.asarray((np.arange(self.rows) - (self.rows - 1) / 2.0) * self.search.pitch_rad, dtype=np.float64)

    def beam_at(self, time_s: Floats, within_s: Floats) -> tuple[Floats, Floats]:
        """Beam's centre (x, y) at each time, in rad.

        Args:
            time_s: Times from the begin of the scan, in s, any shape.
            within_s: A time at which the row meant is being scanned, in s, of the shape of the times.
        """
        period = self.row_time_s + self.turn_around_s
        row = np.clip(np.floor(within_s / period), 0, self.rows - 1)
        along = np.clip(time_s - row * period, 0.0, self.row_time_s) * self.speed_rad_s - self.search.radius_rad
        return np.where(row % 2 == 0, along, -along), (row - (self.rows - 1) / 2.0) * self.search.pitch_rad

    def windows(self, x_rad: Floats, y_rad: Floats, reach_rad: float) -> tuple[Floats, Floats]:
        """Start and end of the times when the beam may be near each target, in s, each of shape (targets, windows).

        Args:
            x_rad: Place of each target along x, in rad from the middle of the search, shape (targets,).
            y_rad: The same along y, shape (targets,).
            reach_rad: Distance from the beam's centre that counts as near, in rad.
        """
        count = min(math.ceil(2.0 * reach_rad / self.search.pitch_rad) + 1, self.rows)
        nearest = y_rad / self.search.pitch_rad + (self.rows - 1) / 2.0
        first = np.clip(np.round(nearest - (count - 1) / 2.0), 0, self.rows - count)
        row = first[:, None] + np.arange(count)
        along = np.where(row % 2 == 0, x_rad[:, None], -x_rad[:, None]) + self.search.radius_rad
        begin = row * (self.row_time_s + self.turn_around_s)
        low = np.clip((along - reach_rad) / self.speed_rad_s, 0.0, self.row_time_s)
        high = np.clip((along + reach_rad) / self.speed_rad_s, 0.0, self.row_time_s)
        return begin + low, begin + high


@dataclass(frozen=True, slots=True)
class StepStare(Bounded):
    """Dwells on a hexagonal grid over the disc, ring after ring outward, each with `dwell_s`, `settle_s` between them.

    Neighbours are one pitch apart. The grid leaves no gap when the overlap is at least 1 - sqrt(3)/2 = 0.134.
    """

    search: Search
    detector: Detector
    dwell_s: Duration
    settle_s: DurationOrZero = 0.0

    def __post_init__(self) -> None:
        """Raises ValueError if a time is negative or the dwell shorter than the detection time."""
        Bounded.__post_init__(self)
        if self.dwell_s < self.detector.detection_time_s * (1.0 - 1e-9):
            raise ValueError(
                f"the dwell of {format_input(self.dwell_s, 's')} is shorter than the detection time of"
                f" {format_limit(self.detector.detection_time_s, 's', least=True)}: dwell at least that long"
            )

    @property
    def basis_rad(self) -> Floats:
        """The two steps of the grid as rows, (2, 2)."""
        pitch = self.search.pitch_rad
        return np.array([(pitch, 0.0), (pitch / 2.0, pitch * math.sqrt(3.0) / 2.0)])

    def order(self, index: NDArray[np.int64]) -> NDArray[np.int64]:
        """Number, from 0, of the dwell at each grid index (..., 2); the number of dwells where there is none."""
        table, size = _dwell_order(self)
        half = table.shape[0] // 2
        inside = np.all(np.abs(index) <= half, axis=-1)
        clipped = np.clip(index + half, 0, 2 * half)
        return np.where(inside, table[clipped[..., 0], clipped[..., 1]], size)

    @property
    def dwells(self) -> int:
        """Number of dwells."""
        return int(_dwell_indices(self).shape[0])

    @property
    def duration_s(self) -> float:
        """Time of one scan: dwells and the settling between them."""
        return self.dwells * (self.dwell_s + self.settle_s) - self.settle_s

    def near(self, reach_rad: float) -> NDArray[np.int64]:
        """Grid steps (n, 2) from a target's nearest dwell to all dwells that may be within `reach_rad` of it."""
        span = math.ceil(2.0 * (reach_rad / self.search.pitch_rad + 1.0))
        steps = _square_indices(span)
        length = np.hypot(*(steps @ self.basis_rad).T)
        return np.asarray(steps[length <= reach_rad + self.search.pitch_rad], dtype=np.int64)

    def beam_at(self, time_s: Floats, within_s: Floats) -> tuple[Floats, Floats]:
        """Beam's centre (x, y) in the dwell that is under way, in rad.

        Args:
            time_s: Times from the begin of the scan, in s; the beam rests, so that they are not needed.
            within_s: A time within the dwell meant, in s, any shape.
        """
        dwell = np.clip(np.floor(within_s / (self.dwell_s + self.settle_s)), 0, self.dwells - 1).astype(np.int64)
        place = _dwell_indices(self)[dwell] @ self.basis_rad
        return place[..., 0], place[..., 1]

    def windows(self, x_rad: Floats, y_rad: Floats, reach_rad: float) -> tuple[Floats, Floats]:
        """Start and end of the dwells near each target, in s, each of shape (targets, windows); empty ones at the end.

        Args:
            x_rad: Place of each target along x, in rad from the middle of the search, shape (targets,).
            y_rad: The same along y, shape (targets,).
            reach_rad: Distance from the beam's centre that counts as near, in rad.
        """
        place = np.stack([x_rad, y_rad], axis=-1) @ np.linalg.inv(self.basis_rad)
        nearest = np.round(place).astype(np.int64)
        number = np.sort(self.order(nearest[:, None, :] + self.near(reach_rad)), axis=1)
        start = number * (self.dwell_s + self.settle_s)
        end = np.where(number < self.dwells, start + self.dwell_s, self.duration_s)
        return np.minimum(start, self.duration_s), end


Scan = Spiral | Raster | StepStare


def highest_speed(search: Search, detection_time_s: float) -> float:
    """Highest speed at which a target half way between two tracks is still seen for the detection time, in rad/s.

    The chord there is 2 a sqrt(1 - (1 - overlap)^2). With no overlap it is zero: such a search always leaves targets
    that no track sees long enough. Faster, down to the whole diameter, the swath is narrower than the pitch.

    Args:
        search: The searched disc with beam radius and overlap.
        detection_time_s: Time for which the beam has to stay on the target, in s.

    Raises:
        ValueError: If the time is not finite and above zero.
    """
    Quantity("s", above=0.0).check("the detection time", detection_time_s)
    chord = 2.0 * search.beam_radius_rad * math.sqrt(1.0 - (1.0 - search.overlap) ** 2)
    return chord / detection_time_s


def _check_speed(search: Search, detector: Detector, speed_rad_s: float) -> None:
    most = 2.0 * search.beam_radius_rad / detector.detection_time_s
    if speed_rad_s > most * (1.0 + 1e-9):
        raise ValueError(
            f"at {format_input(speed_rad_s, 'rad/s')} the beam crosses the target faster than the detection time of"
            f" {format_quantity(detector.detection_time_s, 's')}: scan at {format_limit(most, 'rad/s')} or slower"
        )


def _square_indices(span: int) -> NDArray[np.int64]:
    side = np.arange(-span, span + 1)
    return np.stack(np.meshgrid(side, side, indexing="ij"), axis=-1).reshape(-1, 2)


@lru_cache(maxsize=8)
def _dwell_indices(scan: StepStare) -> NDArray[np.int64]:
    span = math.ceil(1.2 * scan.search.radius_rad / scan.search.pitch_rad) + 1
    index = _square_indices(span)
    place = index @ scan.basis_rad
    inside = np.hypot(place[:, 0], place[:, 1]) <= scan.search.radius_rad
    index, place = index[inside], place[inside]
    first, second = index[:, 0], index[:, 1]
    ring = np.maximum(np.maximum(np.abs(first), np.abs(second)), np.abs(first + second))
    azimuth = np.arctan2(place[:, 1], place[:, 0])
    return np.asarray(index[np.lexsort((azimuth, ring))], dtype=np.int64)


@lru_cache(maxsize=8)
def _dwell_order(scan: StepStare) -> tuple[NDArray[np.int64], int]:
    index = _dwell_indices(scan)
    half = int(np.max(np.abs(index))) if index.size else 0
    table = np.full((2 * half + 1, 2 * half + 1), index.shape[0], dtype=np.int64)
    table[index[:, 0] + half, index[:, 1] + half] = np.arange(index.shape[0])
    return table, int(index.shape[0])
