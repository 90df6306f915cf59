"""A link and a search by numbers alone, without a mission file: floats in, records out."""

import math
from collections.abc import Mapping
from dataclasses import dataclass

from microrad.core.budget import Line, total_db
from microrad.core.units import LEAST, MOST, format_quantity
from microrad.link import gains
from microrad.link.acquisition.detection import detection_times
from microrad.link.acquisition.scan import Detector, Search, Spiral, highest_speed
from microrad.link.acquisition.times import TimeDistribution
from microrad.mission.fields import Quantity, Share

_GIVEN = "given"
_SPEED = 0.9  # of the highest one


def _check(name: str, value: float, rule: Quantity, why: str = "") -> None:
    """Raises ValueError for a value out of bounds, and for one of a size that no quantity has."""
    rule.check(name, value, why)
    if value and not LEAST <= abs(value) <= MOST:
        raise ValueError(f"{name} is {value:g} {rule.unit}: nothing is below {LEAST:g} or above {MOST:g} in SI units")


@dataclass(frozen=True, slots=True)
class ReceivedPower:
    """Lines of a beam from the laser to the detector, which add up to ``received_dbm``; losses are negative.

    ``warnings`` say where a formula is used beyond where it holds.
    """

    lines: tuple[Line, ...]

    @property
    def received_dbm(self) -> float:
        """Sum of the lines."""
        return total_db(self.lines)

    @property
    def warnings(self) -> tuple[str, ...]:
        """What a reader must not overlook."""
        return tuple(f"{line.name}: {line.warning}" for line in self.lines if line.warning)

    def margin_db(self, required_dbm: float) -> float:
        """Received over required power.

        Args:
            required_dbm: Power that the receiver needs (dBm).
        """
        return self.received_dbm - required_dbm


def received_power(
    power_w: float,
    half_angle_rad: float,
    distance_m: float,
    aperture_m: float,
    wavelength_m: float,
    *,
    pointing_error_rad: float = 0.0,
    losses_db: Mapping[str, float] | None = None,
) -> ReceivedPower:
    """Power that a Gaussian beam brings through free space into an aperture, line by line.

    Args:
        power_w: Power of the beam (W), above 0.
        half_angle_rad: Its half angle at 1/e2 of intensity in the far field (rad), above 0.
        distance_m: Distance (m), above 0.
        aperture_m: Diameter of the receiving aperture (m), above 0.
        wavelength_m: Wavelength (m), above 0.
        pointing_error_rad: Static angle between the axis of the beam and the receiver (rad), 0 or above.
        losses_db: Further losses by name (dB), each positive: optics, Strehl, obscuration, code.

    Raises:
        ValueError: For a number out of these bounds; says which.

    Example:
        ```python
        import microrad

        power = microrad.received_power(
            power_w=1.0, half_angle_rad=8e-6, distance_m=45e6, aperture_m=0.25, wavelength_m=1064e-9,
            pointing_error_rad=2e-6, losses_db={"transmit optics": 1.0, "receive optics": 3.0},
        )
        for line in power.lines:
            print(f"{line.name:20} {line.value:9.2f} {line.unit}")
        print(power.received_dbm, power.margin_db(required_dbm=-45.0), power.warnings)
        ```
    """
    above = {"the power": (power_w, "W"), "the half angle": (half_angle_rad, "rad"), "the distance": (distance_m, "m")}
    above |= {"the receiving aperture": (aperture_m, "m"), "the wavelength": (wavelength_m, "m")}
    for name, (value, unit) in above.items():
        _check(name, value, Quantity(unit, above=0.0))
    _check("the pointing error", pointing_error_rad, Quantity("rad", least=0.0))
    waist = wavelength_m / (math.pi * half_angle_rad)
    far = gains.far_field_m(2.0 * waist, wavelength_m)
    near = "" if distance_m >= far else f"the far field of this beam begins at {format_quantity(far, 'm')}"
    beam, angle = "G = 8 / theta^2", f"theta = {format_quantity(half_angle_rad, 'rad')} at 1/e2"
    lines = [
        Line("Power", gains.dbm(power_w), "dBm", "10 log10(P / 1 mW)", _GIVEN, ""),
        Line("Transmit gain", gains.gaussian_beam_gain_db(half_angle_rad), "dB", beam, angle, "far field", near),
        Line(
            "Pointing loss",
            0.0 - float(gains.gaussian_pointing_loss_db(pointing_error_rad, half_angle_rad)),
            "dB",
            "exp(-2 (error / theta)^2)",
            _GIVEN,
            "Gaussian beam, static error",
        ),
        Line(
            "Free space",
            -gains.free_space_loss_db(distance_m, wavelength_m),
            "dB",
            "(lambda / (4 pi d))^2",
            _GIVEN,
            "far field",
        ),
        Line(
            "Receive gain",
            gains.aperture_gain_db(aperture_m, wavelength_m),
            "dB",
            "(pi D / lambda)^2",
            _GIVEN,
            "on axis, uniformly filled",
        ),
    ]
    for name, loss in (losses_db or {}).items():
        _check(f"the loss {name!r}", loss, Quantity("dB", least=0.0), "a loss is positive")
        lines.append(Line(name, 0.0 - loss, "dB", _GIVEN, _GIVEN, ""))
    return ReceivedPower(tuple(lines))


def scan_times(
    sigma_rad: float,
    beam_radius_rad: float,
    detection_time_s: float,
    *,
    coverage: float = 0.99,
    overlap: float = 0.2,
    detection_probability: float = 1.0,
    jitter_rms_rad: float = 0.0,
) -> TimeDistribution:
    """When a spiral scan finds its partner: times and their probabilities, those of a miss left out.

    The beam moves at nine tenths of the speed at which a target half way between two straight tracks is still lit for
    the detection time: tracks bend near the middle, and there a target is lit for less.

    Args:
        sigma_rad: Standard deviation of where the partner is, per axis (rad), above 0.
        beam_radius_rad: Half angle within which the power suffices for detection (rad), above 0.
        detection_time_s: Time for which the beam has to stay on the partner (s), above 0.
        coverage: Probability that the partner lies within the searched disc, 0 to below 1.
        overlap: Share of the beam's diameter by which neighbouring tracks overlap, above 0 and below 1.
        detection_probability: Probability that one look detects, above 0.
        jitter_rms_rad: Vibration of the beam during the scan, rms per axis (rad).

    Raises:
        ValueError: For a number out of these bounds; says which.

    Example:
        ```python
        import microrad

        times = microrad.scan_times(sigma_rad=100e-6, beam_radius_rad=20e-6, detection_time_s=5e-3)
        print(f"found with {times.probability:.1%}, half of the time within {times.quantile(0.5):.2f} s")
        ```
    """
    _check("sigma_rad", sigma_rad, Quantity("rad", above=0.0))
    _check("the radius of the beam", beam_radius_rad, Quantity("rad", above=0.0))
    _check("the detection time", detection_time_s, Quantity("s", above=0.0))
    _check("the jitter", jitter_rms_rad, Quantity("rad", least=0.0))
    why = "without overlap some targets are never lit long enough"
    Share("", above=0.0, below=1.0).check("the overlap", overlap, why)
    search = Search(sigma_rad, beam_radius_rad, overlap, coverage)
    speed = _SPEED * highest_speed(search, detection_time_s)
    return detection_times(Spiral(search, Detector(detection_time_s, detection_probability), speed), jitter_rms_rad)
