"""What measures the loop: the optical sensor of the line of sight, its noise from received power, and the strain gauge.

Angles are line-of-sight angles outside the telescope, per axis; noise is a standard deviation per axis and sample.
"""

import math
from dataclasses import dataclass

from microrad.core.budget import Line, root_sum_square
from microrad.core.units import ELEMENTARY_CHARGE_C, LEAST, MOST, format_quantity

RATE_TOLERANCE = 1e-9
"""How far, relatively, a sensor's period or delay may lie from a whole number of control samples or plant steps."""

EXPOSURE = "it runs from the middle of the exposure to the delivery"

_NOT_STATED = "not stated"


# ------------------------------------------------------------------------------------------------------------- sensors
@dataclass(frozen=True, slots=True)
class OpticalSensor:
    """Quad cell or position detector as the loop sees it: late, noisy, coarse, and blind outside its field of view.

    ``noise_rad`` is the noise-equivalent angle: white from sample to sample, independent between the axes. The spot is
    lost where the radial error exceeds ``field_of_view_rad``, a half angle (infinite: never). ``resolution_rad`` is one
    count, 0 ideal. At each ``every``-th control sample it delivers the error of ``delay_steps`` plant steps ago.

    Raises ValueError for a value without meaning.
    """

    noise_rad: float
    field_of_view_rad: float
    resolution_rad: float
    every: int
    delay_steps: int

    def __post_init__(self) -> None:
        """Check each value."""
        _zero_or_more("optical sensor: noise_rad", self.noise_rad, "rad", "0 rad switches the noise off")
        if not self.field_of_view_rad > 0.0:
            raise ValueError(
                f"optical sensor: field_of_view_rad is {_shown(self.field_of_view_rad, 'rad')}, so it never sees the "
                "spot; give the radial half angle beyond which the spot is lost, above 0 rad (inf: never lost)"
            )
        _zero_or_more("optical sensor: resolution_rad", self.resolution_rad, "rad", "0 rad is an ideal converter")
        _whole("optical sensor: every", self.every, 1, "control samples from one sensor sample to the next")
        _whole("optical sensor: delay_steps", self.delay_steps, 0, "plant steps from exposure to delivery")


@dataclass(frozen=True, slots=True)
class StrainGauge:
    """Sensor of the mirror's own angle at each control sample, without delay; angles as at the line of sight.

    ``resolution_rad`` is one count, 0 ideal. Raises ValueError for a value without meaning.
    """

    noise_rad: float
    resolution_rad: float

    def __post_init__(self) -> None:
        """Check each value."""
        _zero_or_more("strain gauge: noise_rad", self.noise_rad, "rad", "0 rad switches the noise off")
        _zero_or_more("strain gauge: resolution_rad", self.resolution_rad, "rad", "0 rad is an ideal converter")


def optical_sensor(
    noise_rad: float,
    field_of_view_rad: float,
    *,
    rate_hz: float,
    delay_s: float,
    control_rate_hz: float,
    plant_step_s: float,
    resolution_rad: float = 0.0,
) -> OpticalSensor:
    """Optical sensor from its sample rate and its delay, as whole control samples and plant steps.

    Args:
        noise_rad: Noise-equivalent angle, per axis and sample.
        field_of_view_rad: Radial half angle beyond which the spot is lost; infinite for never.
        rate_hz: Sample rate, a whole fraction of the control rate.
        delay_s: From the middle of the exposure to the delivery, a whole number of plant steps: a detector that
            integrates over its whole sample period adds half of that period to its read-out time.
        control_rate_hz: Rate of the controller.
        plant_step_s: Step at which the plant is simulated.
        resolution_rad: One count; 0 is an ideal converter.

    Raises:
        ValueError: When the rate is above the control rate or no whole fraction of it, or the delay is no whole number
            of plant steps, with the nearest value that would do; and for what `OpticalSensor` refuses.
    """
    _above_zero("control rate", control_rate_hz, "Hz")
    _above_zero("plant step", plant_step_s, "s")
    every = _every(rate_hz, control_rate_hz)
    steps = delay_steps("optical sensor", delay_s, plant_step_s, EXPOSURE)
    return OpticalSensor(noise_rad, field_of_view_rad, resolution_rad, every, steps)


def _every(rate_hz: float, control_rate_hz: float) -> int:
    _above_zero("optical sensor: sample rate", rate_hz, "Hz")
    ratio = control_rate_hz / rate_hz
    control = format_quantity(control_rate_hz, "Hz", 12)
    if ratio < 1.0 - RATE_TOLERANCE:
        raise ValueError(
            f"optical sensor: its sample rate of {format_quantity(rate_hz, 'Hz', 12)} is above the control rate of "
            f"{control}: the controller would never read some of its samples; the nearest rate that would do is "
            f"{control}, or raise the control rate (an average of n samples has 1/sqrt(n) of the noise)"
        )
    every = round(ratio)
    if abs(every - ratio) > RATE_TOLERANCE * ratio:
        rates = (control_rate_hz / math.floor(ratio), control_rate_hz / math.ceil(ratio))
        nearest = min(rates, key=lambda rate: abs(rate - rate_hz))
        raise ValueError(
            f"optical sensor: its sample rate of {format_quantity(rate_hz, 'Hz', 12)} does not divide the control rate "
            f"of {control} (into {ratio:.6g} parts): its samples would fall between those of the controller; the "
            f"nearest rate that would do is {format_quantity(nearest, 'Hz', 12)}"
        )
    return every


def delay_steps(what: str, delay_s: float, plant_step_s: float, note: str) -> int:
    """A delay as a whole number of plant steps.

    Args:
        what: Whose delay it is, as a message begins.
        delay_s: The delay (s), 0 or above.
        plant_step_s: Step at which the plant is simulated (s).
        note: What it counts, for the message about one that is no delay.

    Raises:
        ValueError: It is negative, not finite or no whole number of steps; with the nearest that would do.
    """
    _zero_or_more(f"{what}: delay", delay_s, "s", note)
    steps = round(delay_s / plant_step_s)
    if abs(steps * plant_step_s - delay_s) > RATE_TOLERANCE * delay_s:
        raise ValueError(
            f"{what}: its delay of {format_quantity(delay_s, 's', 12)} is no whole number of plant steps of "
            f"{format_quantity(plant_step_s, 's', 12)}: it would end inside a step; the nearest delay that would do is "
            f"{format_quantity(steps * plant_step_s, 's', 12)}, or choose a plant step that divides it"
        )
    return steps


# ------------------------------------------------------------------------------------------- noise from received power
@dataclass(frozen=True, slots=True)
class QuadCell:
    """Four PIN photodiodes, each with its amplifier.

    ``background_power_w`` is what all four receive together besides the signal. ``dark_current_a`` and
    ``thermal_noise_a_sqrt_hz``, the one-sided noise density referred to the amplifier's input (sqrt(4 k T / R) for a
    resistor R alone), are those of one cell. Raises ValueError for a value without meaning.
    """

    responsivity_a_w: float
    background_power_w: float
    dark_current_a: float
    thermal_noise_a_sqrt_hz: float

    def __post_init__(self) -> None:
        """Check each value."""
        _above_zero("quad cell: responsivity_a_w", self.responsivity_a_w, "A/W")
        _zero_or_more("quad cell: background_power_w", self.background_power_w, "W", "0 W is a dark sky")
        _zero_or_more("quad cell: dark_current_a", self.dark_current_a, "A", "0 A is an ideal cell")
        density = self.thermal_noise_a_sqrt_hz
        _zero_or_more("quad cell: thermal_noise_a_sqrt_hz", density, "A/sqrt(Hz)", "0 leaves shot noise alone")

    def noise_lines(self, power_w: float, bandwidth_hz: float, source: str = _NOT_STATED) -> tuple[Line, ...]:
        """Noise currents of the four cells together, in A rms: independent, so that their squares add.

        Shot noise is sqrt(2 q I B) (Schottky).

        Args:
            power_w: Signal that all four cells receive together, 0 or above.
            bandwidth_hz: Noise-equivalent bandwidth, above 0, see `noise_bandwidth_hz`.
            source: Where the numbers come from.

        Raises:
            ValueError: For a negative power and a bandwidth that is not above zero.
        """
        _zero_or_more("quad cell: received power", power_w, "W", "0 W is no light at all")
        _above_zero("quad cell: noise bandwidth", bandwidth_hz, "Hz")
        currents = (
            ("Signal shot noise", self.responsivity_a_w * power_w, "I = responsivity x received power"),
            ("Background shot noise", self.responsivity_a_w * self.background_power_w, "I = responsivity x background"),
            ("Dark-current shot noise", 4.0 * self.dark_current_a, "I = dark current of four cells"),
        )
        bandwidth, regime = f"B = {format_quantity(bandwidth_hz, 'Hz')}", "white noise, independent between the cells"
        lines = []
        for name, current, what in currents:
            shot = math.sqrt(2.0 * ELEMENTARY_CHARGE_C * current * bandwidth_hz)
            basis = f"sqrt(2 q I B), {what} = {format_quantity(current, 'A')}, {bandwidth}"
            lines.append(Line(name, shot, "A", basis, source, regime))
        thermal = math.sqrt(4.0 * bandwidth_hz) * self.thermal_noise_a_sqrt_hz
        basis = f"sqrt(4 B) x density of one amplifier, {bandwidth}"
        return (*lines, Line("Thermal noise", thermal, "A", basis, source, regime))

    def signal_to_noise(self, power_w: float, bandwidth_hz: float) -> float:
        """Signal-to-noise ratio of the four cells summed: mean over rms current, a voltage ratio and not one of powers.

        That is SNRv of Tyler and Fried (1982).

        Args:
            power_w: Signal that all four cells receive together, 0 or above.
            bandwidth_hz: Noise-equivalent bandwidth, above 0, see `noise_bandwidth_hz`.

        Raises:
            ValueError: For a negative power and a bandwidth that is not above zero.
        """
        noise = root_sum_square(self.noise_lines(power_w, bandwidth_hz))
        return self.responsivity_a_w * power_w / noise if power_w > 0.0 else 0.0


def noise_bandwidth_hz(rate_hz: float) -> float:
    """Noise-equivalent bandwidth of a detector that integrates over its whole sample period: half the sample rate.

    The integral over f from 0 of sinc^2(f T) is 1/(2 T). A sampled sensor's noise then falls with the root of its rate.
    """
    _above_zero("optical sensor: sample rate", rate_hz, "Hz")
    return rate_hz / 2.0


@dataclass(frozen=True, slots=True)
class AirySpot:
    """Focused by a uniformly lit, unobscured circular aperture (the telescope's): a source of uniform brightness.

    ``source_angle_rad`` is the full angle that the circular source subtends; 0 is a point, as a laser terminal is.
    Raises ValueError for a value without meaning.
    """

    wavelength_m: float
    aperture_m: float
    source_angle_rad: float = 0.0

    def __post_init__(self) -> None:
        """Check each value."""
        _above_zero("spot: wavelength_m", self.wavelength_m, "m")
        _above_zero("spot: aperture_m", self.aperture_m, "m")
        _zero_or_more("spot: source_angle_rad", self.source_angle_rad, "rad", "0 rad is a point source")

    @property
    def basis(self) -> str:
        """The formula of its noise-equivalent angle."""
        return (
            "pi sqrt((3/16)^2 + (n/8)^2) (lambda/D) / SNRv, n = source angle / (lambda/D), "
            f"lambda = {format_quantity(self.wavelength_m, 'm')}, D = {format_quantity(self.aperture_m, 'm')}, "
            f"source angle = {format_quantity(self.source_angle_rad, 'rad')} (Tyler and Fried 1982)"
        )

    @property
    def per_noise_rad(self) -> float:
        """Noise-equivalent angle at a signal-to-noise ratio of 1 (G. A. Tyler and D. L. Fried, JOSA 72 (1982) 804).

        Exact for a point and for a large source; between them within 4.2 % of the integral over the transfer function.
        """
        diffraction_rad = self.wavelength_m / self.aperture_m
        n = self.source_angle_rad / diffraction_rad
        return math.pi * math.hypot(3.0 / 16.0, n / 8.0) * diffraction_rad


@dataclass(frozen=True, slots=True)
class GaussianSpot:
    """Gaussian spot of 1/e2 intensity radius ``radius_m`` on the cell, behind the effective ``focal_length_m``.

    The focal length is that of telescope and lens together (magnification times the lens's): radius over focal length
    is an angle outside the telescope. Raises ValueError for a value without meaning.
    """

    radius_m: float
    focal_length_m: float

    def __post_init__(self) -> None:
        """Check each value."""
        _above_zero("spot: radius_m", self.radius_m, "m")
        _above_zero("spot: focal_length_m", self.focal_length_m, "m")

    @property
    def basis(self) -> str:
        """The formula of its noise-equivalent angle."""
        shown = f"W = {format_quantity(self.radius_m, 'm')} at 1/e2, f = {format_quantity(self.focal_length_m, 'm')}"
        return f"W / (1.596 f SNRv), {shown}"

    @property
    def per_noise_rad(self) -> float:
        """Noise-equivalent angle at a signal-to-noise ratio of 1: W / (1.596 f), where 1.596 is sqrt(8/pi)."""
        return self.radius_m / (math.sqrt(8.0 / math.pi) * self.focal_length_m)


def noise_equivalent_angle_rad(spot: AirySpot | GaussianSpot, signal_to_noise: float) -> float:
    """Standard deviation of the measured angle, per axis, for a spot near the centre of a quad cell.

    Gaps between the cells are not counted, and off centre the answer is less steep.

    Args:
        spot: Spot of light on the cell.
        signal_to_noise: Voltage ratio of the four cells summed (`QuadCell.signal_to_noise`), in the bandwidth that the
            angle's noise is wanted for.

    Raises:
        ValueError: Unless the ratio is above zero: without light there is no angle.
    """
    if not signal_to_noise > 0.0:
        raise ValueError(
            f"noise-equivalent angle: the signal-to-noise ratio is {signal_to_noise:g}, and a quad cell without light "
            "has no angle; give a received power above 0 W"
        )
    return spot.per_noise_rad / signal_to_noise


def noise_equivalent_angle_line(
    cell: QuadCell, spot: AirySpot | GaussianSpot, power_w: float, rate_hz: float, source: str = _NOT_STATED
) -> Line:
    """Noise-equivalent angle per axis and sample of a cell that integrates over its sample period, as a line in rad.

    Args:
        cell: The quad cell.
        spot: Spot of light on it.
        power_w: Signal that all four cells receive together.
        rate_hz: Sample rate of the cell.
        source: Where the numbers come from.

    Raises:
        ValueError: Without light, or for a rate that is not above zero.
    """
    bandwidth = noise_bandwidth_hz(rate_hz)
    ratio = cell.signal_to_noise(power_w, bandwidth)
    given = f"SNRv = {ratio:.4g} at {format_quantity(power_w, 'W')}, B = {format_quantity(bandwidth, 'Hz')}"
    return Line(
        "Noise-equivalent angle",
        noise_equivalent_angle_rad(spot, ratio),
        "rad",
        f"{spot.basis}; {given} (half the sample rate)",
        source,
        "SNRv well above 1, spot near the centre, integrated over the whole sample period, no gaps between the cells",
    )


# ------------------------------------------------------------------------------------------------------------ refusals
def _shown(value: float, unit: str) -> str:
    return format_quantity(value, unit) if math.isfinite(value) else f"{value:g}"


def _zero_or_more(what: str, value: float, unit: str, note: str) -> None:
    if not 0.0 <= value <= MOST:
        most = f" and at most {MOST:g}" if MOST < value < math.inf else ""
        raise ValueError(f"{what} is {_shown(value, unit)}; give a finite number of at least 0{most} ({note})")


def _above_zero(what: str, value: float, unit: str) -> None:
    if not LEAST <= value <= MOST:
        limits = f", from {LEAST:g} to {MOST:g}" if 0.0 < value < math.inf else ""
        raise ValueError(f"{what} is {_shown(value, unit)}; give a finite number above 0 {unit}{limits}")


def _whole(what: str, value: object, least: int, meaning: str) -> None:
    if isinstance(value, bool) or not isinstance(value, int) or value < least:
        raise ValueError(f"{what} is {value!r}; give a whole number of at least {least}: {meaning}")
