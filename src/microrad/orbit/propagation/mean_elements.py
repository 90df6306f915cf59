"""Mean elements of a satellite, and the orbit that SGP4 computes from them.

Sources: Hoots & Roehrich 1980 (Spacetrack Report 3), Vallado et al. 2006 (AIAA 2006-6753). SGP4 is that of the package
sgp4, with the constants WGS 72.
"""

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from microrad.core.arrays import Floats
from microrad.core.units import format_beyond
from microrad.orbit.base import OrbitError, States
from microrad.orbit.earth.epoch import DAY_S, Epoch

MOST_ELEMENTS_AGE_S = 14.0 * DAY_S
"""From the epoch of the elements to the time of a state, either way; further off SGP4 errs by tens of kilometres."""
LEAST_PERIGEE_HEIGHT_M = 120e3
"""Height of perigee below which drag ends an orbit within about a revolution."""
REVOLUTION_RAD = 2.0 * math.pi
"""A revolution, in which files count the mean motion."""

_SGP4_RADIUS_M = 6_378_135.0  # of WGS 72, over which SGP4 counts heights
_SGP4_EPOCH_JULIAN = 2433281.5  # 1949-12-31, from which sgp4init counts days

_DECAYED = "the satellite has decayed, or the time is too far from the epoch of the elements"
REASONS = {
    0: "its formulas give no number for these elements",
    1: f"the mean eccentricity leaves 0 to 1: {_DECAYED}",
    2: f"the mean motion falls below zero: {_DECAYED}",
    3: f"the perturbed eccentricity leaves 0 to 1: {_DECAYED}",
    4: f"the semi-latus rectum falls below zero: {_DECAYED}",
    5: f"the orbit lies below the Earth's surface: {_DECAYED}",
    6: "the satellite is below the Earth's surface: it has decayed",
}
"""What the error codes of SGP4 mean; 0 is its word for no error."""


@dataclass(frozen=True, slots=True)
class ElementSet:
    """Mean elements of a satellite at an epoch, in the sense of SGP4 and in TEME.

    `mean_motion_rad_s` is Kozai's, as TLE and OMM state it; `drag_per_earth_radius` is B*, per radius of the Earth.
    `place` says where in which file the elements stand.
    """

    name: str
    catalogue_number: str
    epoch: Epoch
    mean_motion_rad_s: float
    eccentricity: float
    inclination_rad: float
    node_rad: float
    argument_of_perigee_rad: float
    mean_anomaly_rad: float
    drag_per_earth_radius: float
    place: str


def check_theory(where: str, kind: str) -> None:
    """Refuse elements of another theory than SGP4; those of its deep-space part pass.

    Args:
        where: What a message begins with: the place of the elements.
        kind: Type of the ephemeris as written: 0, 2 or blank is SGP4, 3 its deep-space part.

    Raises:
        OrbitError: For another type.
    """
    if kind not in ("", "0", "2", "3"):
        raise OrbitError(
            f"{where}: the type of the ephemeris is {kind}, elements of another theory than SGP4 (4 is SGP4-XP), which "
            "SGP4 would misread by kilometres; take elements of type 0"
        )


def checked(elements: ElementSet) -> ElementSet:
    """The elements, unchanged, where they are those of a closed orbit.

    Raises:
        OrbitError: For an element out of range.
    """
    revolutions_per_day = elements.mean_motion_rad_s * DAY_S / REVOLUTION_RAD
    ranges = (
        ("eccentricity", elements.eccentricity, 0.0, 1.0, "at least 0 and below 1"),
        ("inclination", math.degrees(elements.inclination_rad), 0.0, 180.0 + 1e-9, "0 to 180 deg"),
        ("mean motion", revolutions_per_day, 1e-3, 20.0, "0.001 to 20 revolutions a day"),
        ("drag term B*", elements.drag_per_earth_radius, -1.0, 1.0, "less than 1 per radius of the Earth, either sign"),
    )
    for what, value, low, high, words in ranges:
        if not low <= value < high:
            raise OrbitError(
                f"{elements.place} ({elements.name}): the {what} is {value:.8g}, and an orbit about the Earth has "
                f"{words}; download the elements again"
            )
    return elements


def closest_elements(sets: tuple[ElementSet, ...], epoch: Epoch) -> ElementSet:
    """The element set whose own epoch is nearest to that of the mission.

    Args:
        sets: Sets of one satellite, at least one.
        epoch: The epoch of the mission.

    Raises:
        OrbitError: For sets of several satellites.
    """
    if len({e.catalogue_number for e in sets}) > 1:
        listed = ", ".join(f"{e.name} ({e.catalogue_number})" for e in sets[:8])
        raise OrbitError(
            f"{sets[0].place}: {len(sets)} element sets of different satellites, {listed}"
            f"{' and others' if len(sets) > 8 else ''}; name one of them, by its number where names repeat"
        )
    return min(sets, key=lambda e: abs(e.epoch.seconds_to(epoch)))


@dataclass(frozen=True, slots=True)
class Sgp4Orbit:
    """The orbit that SGP4 computes from an element set, in seconds since `epoch`; satisfies `Orbit`.

    Raises OrbitError for elements that SGP4 refuses, and for a perigee below `LEAST_PERIGEE_HEIGHT_M`.
    """

    elements: ElementSet
    epoch: Epoch
    elements_age_s: float = field(init=False)
    """From the epoch of the elements to that of the mission; negative when the elements are newer."""
    _satellite: Any = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        """Initialise SGP4."""
        object.__setattr__(self, "elements_age_s", self.elements.epoch.seconds_to(self.epoch))
        object.__setattr__(self, "_satellite", _satellite(self.elements))
        self._check_perigee(-self.elements_age_s)

    def __reduce__(self) -> tuple[type["Sgp4Orbit"], tuple[ElementSet, Epoch]]:
        """Copied to other processes by its elements: the satellite of the package sgp4 cannot be."""
        return Sgp4Orbit, (self.elements, self.epoch)

    @property
    def name(self) -> str:
        """The satellite's name; its catalogue number where the file has no name."""
        return self.elements.name

    def states(self, time_s: Floats) -> States:
        """States in TEME at `time_s`, of shape (3, n).

        Raises:
            OrbitError: Where SGP4 reports an error, and further than `MOST_ELEMENTS_AGE_S` from the elements.
        """
        time = np.atleast_1d(np.asarray(time_s, dtype=np.float64))
        self._check_times(time)
        days = (time + self.elements_age_s) / DAY_S + self._satellite.jdsatepochF
        error, position_km, velocity_km_s = self._satellite.sgp4_array(
            np.full(time.shape, self._satellite.jdsatepoch), days
        )
        failed = np.flatnonzero((error != 0) | ~np.all(np.isfinite(position_km), axis=1))
        if failed.size:
            first = int(failed[0])
            raise self._failed(int(error[first]), float(time[first]))
        position = np.ascontiguousarray(1000.0 * position_km.T)
        velocity = np.ascontiguousarray(1000.0 * velocity_km_s.T)
        if np.ndim(time_s) == 0:
            return States(position[:, 0], velocity[:, 0])
        return States(position, velocity)

    def require(self, start_s: float, end_s: float) -> None:
        """Check that the elements hold over a part of the mission: their age, and the height of perigee.

        The mean perigee is looked at each day and at both ends.

        Args:
            start_s: Its start, s since the epoch of the mission.
            end_s: Its end, likewise.

        Raises:
            OrbitError: Where they are too old or too new, the perigee is too low, or SGP4 stops.
        """
        self._check_times(np.array([start_s, end_s]))
        for time_s in np.linspace(start_s, end_s, 2 + math.ceil(abs(end_s - start_s) / DAY_S)):
            self._check_perigee(float(time_s))

    def _check_times(self, time: Floats) -> None:
        if not time.size:
            return
        furthest = float(time[np.argmax(np.abs(time + self.elements_age_s))])
        if not math.isfinite(furthest):
            raise OrbitError(f"{self._where()}: a time is not a finite number; give seconds since {self.epoch.text}")
        age_s = furthest + self.elements_age_s
        if abs(age_s) > MOST_ELEMENTS_AGE_S + 1e-6:
            state = "expired" if age_s > 0 else "not valid yet"
            raise OrbitError(
                f"{self._where()}: the elements are {state}: their epoch is {self.elements.epoch.text}, the "
                f"mission's {self.epoch.text}, and {self.epoch.utc(furthest)} is {abs(age_s) / DAY_S:.2f} days from "
                f"the elements; SGP4 is trusted for {MOST_ELEMENTS_AGE_S / DAY_S:.0f} days: take "
                f"{'newer' if age_s > 0 else 'older'} elements, or set orbit.epoch near theirs"
            )

    def _check_perigee(self, time_s: float) -> None:
        """Raises OrbitError for a mean perigee that is too low at a time, and where SGP4 itself stops there."""
        satellite = self._satellite
        days = (time_s + self.elements_age_s) / DAY_S + satellite.jdsatepochF
        error, position_km, _ = satellite.sgp4(satellite.jdsatepoch, days)
        if error or not all(map(math.isfinite, position_km)):
            raise self._failed(error, time_s)
        height_m = (satellite.am * (1.0 - satellite.em) - 1.0) * _SGP4_RADIUS_M
        if height_m < LEAST_PERIGEE_HEIGHT_M:
            height = format_beyond(height_m, LEAST_PERIGEE_HEIGHT_M, "m", 3)
            raise OrbitError(
                f"{self._where()}: the perigee is {height} high at {self.epoch.utc(time_s)}; below "
                f"{LEAST_PERIGEE_HEIGHT_M / 1e3:.0f} km an orbit decays within about a revolution: choose another "
                "satellite, or an epoch before its decay"
            )

    def _failed(self, error: int, time_s: float) -> OrbitError:
        reason = REASONS.get(error, f"error {error}")
        return OrbitError(
            f"{self._where()}: SGP4 stops at {self.epoch.utc(time_s)}, {time_s + self.elements_age_s:.0f} s from the "
            f"epoch of the elements: {reason}; take newer elements or an earlier epoch"
        )

    def _where(self) -> str:
        return f"{self.elements.place} ({self.name})"


def _satellite(elements: ElementSet) -> Any:
    """The satellite as the package sgp4 has it."""
    from sgp4.api import WGS72, Satrec

    # Added in this order as the published code does: it rounds the epoch to 40 us, which moves the Moon by millimetres.
    days = sum(elements.epoch.julian_date) - _SGP4_EPOCH_JULIAN
    satellite = Satrec()
    satellite.sgp4init(
        WGS72, "i", 0, days, elements.drag_per_earth_radius, 0.0, 0.0,
        elements.eccentricity, elements.argument_of_perigee_rad, elements.inclination_rad, elements.mean_anomaly_rad,
        60.0 * elements.mean_motion_rad_s, elements.node_rad,
    )  # fmt: skip
    return satellite
