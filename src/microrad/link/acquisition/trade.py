"""A wide beacon against a scan by a narrow beam: time and probability over the uncertainty."""

import math
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import ArrayLike

from microrad.core.arrays import Floats
from microrad.link.acquisition import scan
from microrad.link.acquisition.detection import detection_times
from microrad.mission.fields import Bounded, Quantity

Power = Annotated[float, Quantity("W", above=0.0)]

_WIDE_PER_RADIUS = math.sqrt(2.0)
"""Half angle at 1/e2 of the beam with the most irradiance at a radius that it has to cover, over that radius."""


@dataclass(frozen=True, slots=True)
class Receiver(Bounded):
    """The partner's acquisition receiver: it detects `power_w` behind its aperture within `time_s`.

    Its noise is white and does not depend on the light: the time falls with the square of the power. A one-sided
    noise-equivalent power N in W/sqrt(Hz) and a needed ratio r of signal to rms noise are r N / sqrt(2) in 1 s.
    """

    aperture_area_m2: Annotated[float, Quantity("m^2", above=0.0)]
    power_w: Power
    time_s: scan.Duration
    shortest_s: scan.DurationOrZero = 0.0

    def detection_time_s(self, power_w: ArrayLike) -> Floats:
        """Time to detection at each received power, at least `shortest_s`."""
        less = self.power_w / np.asarray(power_w, dtype=np.float64)
        return np.asarray(np.maximum(self.time_s * less**2, self.shortest_s))


@dataclass(frozen=True, slots=True)
class Beams(Bounded):
    """The transmitter and its two beams at one range.

    `power_w` is the power that leaves the terminal, losses taken off. The narrow beam has the half angle
    `narrow_half_angle_rad` at 1/e2 and is used out to `beam_radius_rad`; its tracks overlap by the share `overlap`
    of its diameter.
    """

    power_w: Power
    range_m: Annotated[float, Quantity("m", above=0.0)]
    narrow_half_angle_rad: scan.OffAxis
    beam_radius_rad: scan.OffAxis
    overlap: scan.Overlap

    @property
    def edge_irradiance_w_m2(self) -> float:
        """Irradiance at the partner where the narrow beam is just used."""
        return float(self.irradiance_w_m2(self.narrow_half_angle_rad, self.beam_radius_rad))

    def irradiance_w_m2(self, half_angle_rad: ArrayLike, off_axis_rad: ArrayLike) -> Floats:
        """Irradiance of a Gaussian beam at the partner in W/m^2: 2 P / (pi w^2 L^2) exp(-2 (angle / w)^2), w at 1/e2.

        Args:
            half_angle_rad: Half angle w of the beam at 1/e2, in rad; broadcast against the other angle.
            off_axis_rad: Angle of the partner from the beam's axis, in rad.
        """
        half = np.asarray(half_angle_rad, dtype=np.float64)
        off = np.asarray(off_axis_rad, dtype=np.float64)
        on_axis = 2.0 * self.power_w / (math.pi * (half * self.range_m) ** 2)
        return np.asarray(on_axis * np.exp(-2.0 * (off / half) ** 2))


@dataclass(frozen=True, slots=True, eq=False)
class Trade:
    """Both ways over the uncertainty, (n,) arrays; times without settling and light time.

    The wide beacon takes `wide_time_s` and succeeds with `wide_probability`, the coverage; the scan lasts at most
    `scan_time_s`, detects with `scan_probability` and then takes `scan_mean_time_s` in the mean, at `speed_rad_s`.
    """

    sigma_rad: Floats
    radius_rad: Floats
    wide_full_angle_rad: Floats
    wide_time_s: Floats
    wide_probability: Floats
    scan_time_s: Floats
    scan_mean_time_s: Floats
    scan_probability: Floats
    speed_rad_s: float


def wide_against_scan(
    sigma_rad: ArrayLike,
    coverage: float,
    beams: Beams,
    receiver: Receiver,
    jitter_rms_rad: float = 0.0,
) -> Trade:
    """Compare a wide beacon with a spiral scan, for each uncertainty (paper, section 2.1).

    Both are dimensioned at the edge: the wide beacon integrates until a target on the radius of `coverage` is detected,
    the scan is as slow as a target half way between two tracks and `beam_radius_rad` off the axis needs. The wide
    beam's half angle at 1/e2 is sqrt(2) times the radius: no other is brighter there. The vibration is small against
    the wide beam and left out there.

    Args:
        sigma_rad: Rms uncertainty of the direction about each axis, in rad, a number or shape (cases,).
        coverage: Probability that the target is inside the searched disc.
        beams: The transmitter with its two beams.
        receiver: The partner's receiver, which says how long it has to be lit.
        jitter_rms_rad: Rms of the vibration about each axis, in rad.

    Raises:
        ValueError: For tracks that do not overlap.
    """
    sigma = np.atleast_1d(np.asarray(sigma_rad, dtype=np.float64))
    if beams.overlap == 0.0:
        raise ValueError("the overlap is 0: it must be above 0, or a target between two tracks is seen for no time")
    searches = [scan.Search(float(s), beams.beam_radius_rad, beams.overlap, coverage) for s in sigma]
    radius = np.array([search.radius_rad for search in searches])
    wide = _WIDE_PER_RADIUS * radius
    area = receiver.aperture_area_m2
    wide_time = receiver.detection_time_s(area * beams.irradiance_w_m2(wide, radius))
    detector = scan.Detector(float(receiver.detection_time_s(area * beams.edge_irradiance_w_m2)))
    speed = scan.highest_speed(searches[0], detector.detection_time_s)
    scans = [scan.Spiral(search, detector, speed) for search in searches]
    found = [detection_times(each, jitter_rms_rad) for each in scans]
    return Trade(
        sigma_rad=sigma,
        radius_rad=radius,
        wide_full_angle_rad=2.0 * wide,
        wide_time_s=wide_time,
        wide_probability=np.full(sigma.size, coverage),
        scan_time_s=np.array([each.duration_s for each in scans]),
        scan_mean_time_s=np.array([times.mean_s for times in found]),
        scan_probability=np.array([times.probability for times in found]),
        speed_rad_s=speed,
    )
