"""A wide beacon against a scan by a narrow beam: time and probability over the uncertainty."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from microrad.acquisition.detection import detection_times
from microrad.acquisition.limits import require_angle, require_not_negative, require_positive
from microrad.acquisition.scan import Detector, Search, Spiral, highest_speed
from microrad.units import format_quantity

_Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Receiver:
    """The partner's acquisition receiver: it detects when the signal-to-noise ratio reaches `needed_snr`.

    The ratio of signal to rms noise after a time t with the power P is P t / sqrt((k^2 + e P) t), with k =
    `thermal_w_root_s`, the power of ratio 1 after one second under thermal noise alone (ratio P sqrt(t) / k), and e =
    `shot_j`, the energy of ratio 1 under shot noise alone (ratio sqrt(P t / e)): the photon energy over the quantum
    efficiency. A noise-equivalent power in W/sqrt(Hz), one-sided, is k sqrt(2). One of the two may be zero.
    """

    aperture_area_m2: float
    needed_snr: float
    thermal_w_root_s: float
    shot_j: float
    shortest_s: float = 0.0

    def __post_init__(self) -> None:
        """Refuse values that are not positive; one of the two noises must be."""
        require_positive("the receiver's aperture area", self.aperture_area_m2, "m^2")
        require_positive("the needed signal-to-noise ratio", self.needed_snr, "")
        require_not_negative("the thermal noise", self.thermal_w_root_s, "W")
        require_not_negative("the energy of the shot noise", self.shot_j, "J")
        require_not_negative("the shortest detection time", self.shortest_s, "s")
        if self.thermal_w_root_s == 0.0 and self.shot_j == 0.0:
            raise ValueError("the receiver has no noise: give a thermal or a shot noise above zero")

    def detection_time_s(self, power_w: ArrayLike) -> _Array:
        """Time to the needed ratio at each received power: snr^2 (k^2 + e P) / P^2, at least `shortest_s`."""
        power = np.asarray(power_w, dtype=np.float64)
        noise = self.thermal_w_root_s**2 + self.shot_j * power
        return np.asarray(np.maximum(self.needed_snr**2 * noise / power**2, self.shortest_s))


@dataclass(frozen=True, slots=True)
class Beams:
    """The transmitter and its two beams at one range.

    `power_w` is the power that leaves the terminal, losses taken off. The narrow beam has the half angle
    `narrow_half_angle_rad` at 1/e2 and is used out to `beam_radius_rad`. The wide beam's half angle at 1/e2 is
    `wide_per_radius` times the radius it has to cover: sqrt(2) gives the most irradiance at that edge.
    """

    power_w: float
    range_m: float
    narrow_half_angle_rad: float
    beam_radius_rad: float
    overlap: float
    wide_per_radius: float = math.sqrt(2.0)

    def __post_init__(self) -> None:
        """Refuse values that are not positive, and an overlap that leaves no time between two tracks."""
        require_positive("the transmitted power", self.power_w, "W")
        require_positive("the range", self.range_m, "m")
        require_angle("the narrow beam's half angle", self.narrow_half_angle_rad)
        require_angle("the beam's radius", self.beam_radius_rad)
        require_positive("the wide beam's half angle per radius", self.wide_per_radius, "")
        if not 0.0 < self.overlap < 1.0:
            raise ValueError(
                f"the overlap is {self.overlap:g}: it must lie above 0 and below 1; with none a target between two"
                " tracks is seen for no time"
            )

    def irradiance_w_m2(self, half_angle_rad: ArrayLike, off_axis_rad: ArrayLike) -> _Array:
        """Irradiance of a Gaussian beam at the partner: 2 P / (pi w^2 L^2) exp(-2 (angle / w)^2), w at 1/e2."""
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

    sigma_rad: _Array
    radius_rad: _Array
    wide_full_angle_rad: _Array
    wide_time_s: _Array
    wide_probability: _Array
    scan_time_s: _Array
    scan_mean_time_s: _Array
    scan_probability: _Array
    speed_rad_s: float


def wide_against_scan(
    sigma_rad: ArrayLike,
    coverage: float,
    beams: Beams,
    receiver: Receiver,
    fastest_rad_s: float = math.inf,
    jitter_rms_rad: float = 0.0,
) -> Trade:
    """Time and probability of the wide beacon and of a spiral scan for each uncertainty per axis (paper, section 2.1).

    Both are dimensioned at the edge: the wide beacon integrates until a target on the radius of `coverage` is
    detected, the scan is as slow as a target half way between two tracks and `beam_radius_rad` off the axis needs,
    or at `fastest_rad_s` if that is slower. The wide beacon sees no `jitter_rms_rad`, which is small against it.
    """
    sigma = np.atleast_1d(np.asarray(sigma_rad, dtype=np.float64))
    if not fastest_rad_s > 0.0:
        raise ValueError(f"the fastest scan is {format_quantity(fastest_rad_s, 'rad/s')}: it must be above 0 rad/s")
    searches = [Search(float(s), beams.beam_radius_rad, beams.overlap, coverage) for s in sigma]
    radius = np.array([search.radius_rad for search in searches])
    wide = beams.wide_per_radius * radius
    area = receiver.aperture_area_m2
    wide_time = receiver.detection_time_s(area * beams.irradiance_w_m2(wide, radius))
    edge_w = area * beams.irradiance_w_m2(beams.narrow_half_angle_rad, beams.beam_radius_rad)
    detector = Detector(float(receiver.detection_time_s(edge_w)))
    speed = min(highest_speed(searches[0], detector.detection_time_s), fastest_rad_s)
    scans = [Spiral(search, detector, speed) for search in searches]
    found = [detection_times(scan, jitter_rms_rad) for scan in scans]
    return Trade(
        sigma_rad=sigma,
        radius_rad=radius,
        wide_full_angle_rad=2.0 * wide,
        wide_time_s=wide_time,
        wide_probability=np.full(sigma.size, coverage),
        scan_time_s=np.array([scan.duration_s for scan in scans]),
        scan_mean_time_s=np.array([times.mean_s for times in found]),
        scan_probability=np.array([times.probability for times in found]),
        speed_rad_s=speed,
    )
