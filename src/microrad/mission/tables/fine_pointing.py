"""The [fine_pointing] table of a mission: the loop's clock, optics, disturbances, sensors, reference, and its runs.

All angles are of the line of sight outside the telescope, per axis, but for the strain gauge's and the mirror's own.
"""

import math
from collections.abc import Iterator
from typing import Annotated, Literal

from pydantic import Field

from microrad.core.units import counted, format_limit, format_quantity
from microrad.mission.fields import Problem, Quantity, Several, Share, Switch, Table, Whole
from microrad.mission.tables.mirror import ANGLE_MOST, Angle, DurationOrZero, Frequency, Name
from microrad.mission.tables.pointing import TwoOffsets, two_axes_problems

STEP_TOLERANCE = 1e-9
"""How far, relatively, a period or a delay may lie from a whole number of plant steps or control samples."""

MOST_STEPS = 1_000_000
"""Plant steps in a period or a delay beyond which a step is taken for a slip of the pen."""

MOST_RUN_SAMPLES = 100_000_000
"""Control samples of a run beyond which its duration is taken for a slip of the pen."""

WORST_CONDITION = 1e4
"""Ratio of the largest to the smallest gain from drives to line of sight beyond which a geometry is singular."""


# --------------------------------------------------------------------------------------------------- kinds of values
# the upper bounds are no limits of technology: they catch a wrong prefix
AngleOrZero = Annotated[float, Quantity("rad", "urad", least=0.0, most=ANGLE_MOST)]
Seconds = Annotated[float, Quantity("s", above=0.0, most=1e9)]
Step = Annotated[float, Quantity("s", "us", above=0.0)]
Resolution = Annotated[float, Quantity("V", "mV", least=0.0)]
TwoDrifts = Annotated[tuple[float, ...], Several(Quantity("rad/s", "urad/s", least=-ANGLE_MOST, most=ANGLE_MOST))]
Level = Annotated[float, Quantity("rad^2/Hz", "urad^2/Hz", least=0.0, most=1.0)]
Edges = Annotated[tuple[float, ...], Several(Quantity("Hz", least=0.0, most=1e12), rising=True)]
BandRms = Annotated[tuple[float, ...], Several(Quantity("rad", "urad", above=0.0, most=ANGLE_MOST))]
Harmonics = Annotated[tuple[float, ...], Several(Quantity("", above=0.0, most=1e6))]
WheelCoefficients = Annotated[tuple[float, ...], Several(Quantity("rad/Hz^2", "nrad/Hz^2", least=0.0, most=1.0))]
_NO_COUPLING = "[1.0, 0.0, 0.0, 1.0]"
Coupling = Annotated[tuple[float, ...], Several(Quantity("", least=-100.0, most=100.0), example_list=_NO_COUPLING)]
PowerOrZero = Annotated[float, Quantity("W", "pW", least=0.0, most=1e6)]
ReceivedPower = Annotated[float, Quantity("W", "pW", above=0.0, most=1e6)]
Convention = Annotated[
    Literal["radial", "per-axis"], Field(description="radial: of both axes together, shared equally; per-axis: of each")
]


# ------------------------------------------------------------------------------------------------------------- tables
class GeometryTable(Table):
    """From the mirror's outputs to the line of sight."""

    layout: Literal["two-axis", "tripod"] = Field(description="tripod: three actuators 120 degrees apart")
    actuator_radius_m: Annotated[float, Quantity("m", "mm", above=0.0, most=10.0)] | None = Field(
        default=None, description="of the circle that a tripod's actuators stand on"
    )
    incidence_rad: Annotated[float, Quantity("rad", "deg", least=0.0, most=ANGLE_MOST)] = Field(
        description="angle between the beam and the mirror's normal"
    )
    magnification: Annotated[float, Quantity("", above=0.0, most=1e4)] = Field(
        description="of the telescope: the line of sight turns by the beam's angle divided by it"
    )
    rotation_rad: Annotated[float, Quantity("rad", "deg")] = Field(
        description="of the mirror's axes about the line of sight, from x towards y"
    )
    coupling: Coupling = Field(description="row by row: what drives x and y do on axis x, then on axis y")
    travel_angle: Literal["optical", "mechanical"] = Field(
        description="what mirror.travel counts; mechanical: the tilt, optical: twice the tilt"
    )

    def problems(self) -> Iterator[Problem]:
        """A radius exactly for a tripod, and every direction of the line of sight within reach."""
        needed = {"actuator_radius": '"10 mm"'} if self.layout == "tripod" else {}
        yield from self.choice_problems(f'layout = "{self.layout}"', needed, instead=lambda key: 'layout = "tripod"')
        if len(self.coupling) == 4:
            yield from self._reach_problems()
        else:
            reason = f"has {counted(len(self.coupling), 'item')}"
            yield Problem("coupling", reason, f"four, row by row: coupling = {_NO_COUPLING} would do")

    def _reach_problems(self) -> Iterator[Problem]:
        less = f"moves the line of sight over {WORST_CONDITION:g} times less in one direction than across it"
        cos = math.cos(self.incidence_rad)
        singular, grazing = _singular(self.coupling, cos), cos * WORST_CONDITION < 1.0
        if (singular and grazing) or self.incidence_rad >= ANGLE_MOST:
            yield Problem("incidence", f"grazes the mirror, which then {less}", 'incidence = "45 deg" would do')
        if singular and (not grazing or _singular(self.coupling, 1.0)):
            yield Problem("coupling", f"is singular: it {less}", f"coupling = {_NO_COUPLING} would do")


def _singular(coupling: tuple[float, ...], cos_incidence: float) -> bool:
    """Whether diag(1, cos) times the coupling has a condition above the worst one; numpy would be slow to load.

    With singular values s1 and s2, the condition k gives k + 1/k = (s1^2 + s2^2) / (s1 s2): all squares over |det|.
    """
    a, b, c, d = coupling[0], coupling[1], cos_incidence * coupling[2], cos_incidence * coupling[3]
    squares, area = a * a + b * b + c * c + d * d, abs(a * d - b * c)
    return area == 0.0 or squares > (WORST_CONDITION + 1.0 / WORST_CONDITION) * area


_SPECTRUM_KEYS: dict[str, dict[str, str]] = {
    "olympus": {},
    "first-order": {"level": '"160 urad^2/Hz"', "corner": '"1 Hz"'},
    "bands": {"edges": '["0 Hz", "1 Hz"]', "rms": '["8.6 urad"]'},
    "table": {"file": '"spectrum.csv"'},
}
"""The keys that belong to each spectrum, with a value that could stand there."""


class VibrationTable(Table):
    """Base motion of the satellite as a one-sided spectrum; what describes it depends on which spectrum it is."""

    spectrum: Literal["olympus", "first-order", "bands", "table"] = Field(
        description="olympus: 160 / (1 + f^2) urad^2/Hz; first-order: level / (1 + (f/corner)^2); bands: rms by band"
    )
    convention: Convention
    level_rad2_hz: Level | None = Field(default=None, description="first-order: at low frequency")
    corner_hz: Frequency | None = Field(default=None, description="first-order: half of the level")
    edges_hz: Edges | None = Field(default=None, description="bands: rising, the first may be 0 Hz")
    rms_rad: BandRms | None = Field(default=None, description="bands: in each band between the edges")
    file: Name | None = Field(default=None, description="table: two columns, the path seen from the mission file")

    def problems(self) -> Iterator[Problem]:
        """The keys of its spectrum and no others; an rms for each band."""
        of = {key: f'spectrum = "{spectrum}"' for spectrum, keys in _SPECTRUM_KEYS.items() for key in keys}
        yield from self.choice_problems(
            f'spectrum = "{self.spectrum}"', _SPECTRUM_KEYS[self.spectrum], instead=of.__getitem__
        )
        if self.edges_hz is not None and self.rms_rad is not None:
            yield from _band_problems(len(self.edges_hz), len(self.rms_rad))


def _band_problems(edges: int, values: int) -> Iterator[Problem]:
    if edges < 2:
        advice = 'two or more: edges = ["0 Hz", "1 Hz"] and rms = ["8.6 urad"] would do'
        yield Problem("edges", "has 1 item, and a band has two edges", advice)
    elif values != edges - 1:
        reason = f"has {values} item{'s' if values > 1 else ''} where edges has {edges}"
        wanted = f"{edges - 1} items, one for each band" if edges > 2 else "1 item, for the one band"
        yield Problem("rms", reason, f"{wanted} between the edges")


class WheelsTable(Table):
    """Lines of a reaction wheel: the amplitude of each harmonic is its coefficient times the speed squared."""

    speed_hz: Frequency = Field(description="revolutions in a second")
    harmonics: Harmonics = Field(description="frequency of each line over the speed; 1 is the imbalance")
    coefficients_rad_hz2: WheelCoefficients = Field(description="amplitude over speed squared, one for each harmonic")
    convention: Convention

    def problems(self) -> Iterator[Problem]:
        """A coefficient for each harmonic."""
        lines, values = len(self.harmonics), len(self.coefficients_rad_hz2)
        if lines != values:
            counts = f"has {values} item{'s' if values > 1 else ''} where harmonics has {lines}"
            yield Problem("coefficients", counts, f"{lines} of them, one coefficient for each harmonic")


class BodyTable(Table):
    """What the attitude control leaves: slow, a second-order low pass of white noise."""

    error_rad: AngleOrZero = Field(description="as many standard deviations as sigmas says")
    sigmas: Annotated[float, Quantity("", above=0.0, most=100.0)] = Field(description="standard deviations in error")
    bandwidth_hz: Frequency = Field(description="of the attitude control")
    convention: Convention


class MisalignmentTable(Table):
    """What stands between the line of sight and the tracking sensor for good: no controller knows it beforehand.

    In a run it begins where the run does, and each controller has to take it off the error.
    """

    offset_rad: TwoOffsets = Field(description="static, about x and y")
    drift_rad_s: TwoDrifts = Field(description="steady from the begin of a run on, about x and y")

    def problems(self) -> Iterator[Problem]:
        """Two axes."""
        yield from two_axes_problems(offset=(self.offset_rad, "1 urad"), drift=(self.drift_rad_s, "1 urad/s"))


class QuadCellTable(Table):
    """Four photodiodes with an amplifier each, and the light on them, for the sensor's noise-equivalent angle.

    The light is that of the answer, with its wavelength, and with the power of its budget where none is given.
    """

    responsivity_a_w: Annotated[float, Quantity("A/W", above=0.0, most=1e3)] = Field(
        description="current for a watt of light"
    )
    background_power_w: PowerOrZero = Field(description="on all four together")
    dark_current_a: Annotated[float, Quantity("A", "nA", least=0.0, most=1.0)] = Field(description="of one of them")
    thermal_noise_a_sqrt_hz: Annotated[float, Quantity("A/sqrt(Hz)", "pA/sqrt(Hz)", least=0.0, most=1e-3)] = Field(
        description="of one amplifier, one-sided, referred to its input"
    )
    received_power_w: ReceivedPower | None = Field(
        default=None, description="signal on all four together; absent: as the answer's budget"
    )
    spot: Literal["airy"] = Field(description="airy: focused by the whole aperture terminals.leo_aperture")


class OpticalSensorTable(Table):
    """Tracking sensor of the line of sight; its noise is given, or follows from a quad cell and its light."""

    noise_rad: AngleOrZero | None = Field(default=None, description="rms, per axis and reading")
    field_of_view_rad: Angle = Field(description="radial half angle; beyond it the spot is lost")
    resolution_rad: AngleOrZero = Field(description='one count; "0 urad" is ideal')
    rate_hz: Frequency = Field(description="readings in a second; divides fine_pointing.rate")
    delay_s: DurationOrZero = Field(description="middle of the exposure to delivery")
    quad_cell: QuadCellTable | None = Field(default=None, description="in place of noise")

    def problems(self) -> Iterator[Problem]:
        """Noise said once."""
        if self.noise_rad is None and self.quad_cell is None:
            advice = 'noise = "1 urad" would do, or a table quad_cell'
            yield Problem("noise", "is missing, and so is the table quad_cell", advice)
        if self.noise_rad is not None and self.quad_cell is not None:
            yield Problem("noise", "stands beside the table quad_cell", "one of the two removed")


class StrainGaugeTable(Table):
    """Sensor of the mirror, in the mirror's own angle, read at each control sample."""

    noise_rad: AngleOrZero = Field(description="rms, per reading")
    resolution_rad: AngleOrZero = Field(description='one count; "0 urad" is ideal')


class ReferenceTable(Table):
    """The known part of the pointing error: point-ahead, and the orbital motion that the body leaves."""

    point_ahead_rad: AngleOrZero = Field(description="largest, on axis x")
    point_ahead_on_mirror: Annotated[bool, Switch("")] = Field(description="false: another mirror makes it")
    line_of_sight_rate_rad_s: Annotated[float, Quantity("rad/s", "urad/s", least=0.0, most=ANGLE_MOST)] = Field(
        description="largest, on axis x"
    )
    rate_feedforward: Annotated[float, Quantity("", least=0.0, most=1.0)] = Field(
        description="share of that rate that the body turns by command"
    )


class FinePointing(Table):
    """The fine-pointing loop and how it is judged: radial error below which it stays for a share of the time."""

    rate_hz: Frequency = Field(description="sample rate of the controller")
    delay_s: DurationOrZero = Field(description="computation: from sampling to the changed output")
    plant_step_s: Step = Field(description="step of the simulated plant")
    amplifier_bandwidth_hz: Frequency = Field(description="first-order corner, in place of amplifier.bandwidth")
    drive_resolution_v: Resolution = Field(description='one count; "0 V" is ideal')
    reference_filter_hz: Frequency = Field(
        description="bandwidth of the filter that the inverse's target and rate come from"
    )
    modulus_margin: Annotated[float, Share("")] = Field(description="least distance of the loop from -1")
    quantile: Annotated[float, Share("")] = Field(description="share of the time that the radial error is judged at")
    runs: Annotated[int, Whole("", least=1, most=100_000)] = Field(
        description="simulated side by side, each with its own noise"
    )
    duration_s: Seconds = Field(description="of a run, settling included")
    settle_s: Annotated[float, Quantity("s", least=0.0, most=1e9)] = Field(description="left out at the begin of a run")
    seed: Annotated[int, Whole("", least=0, most=2**63 - 1)] = Field(description="of the random numbers of all runs")
    geometry: GeometryTable
    vibration: VibrationTable
    wheels: WheelsTable | None = None
    body: BodyTable
    misalignment: MisalignmentTable | None = None
    optical_sensor: OpticalSensorTable
    strain_gauge: StrainGaugeTable | None = None
    reference: ReferenceTable
    mirror_file: Name | None = Field(
        default=None,
        description="mirror file of version 2, seen from the mission file: one mirror of several axes in this loop, in "
        "place of [mirror] on each axis",
    )

    def problems(self) -> Iterator[Problem]:
        """Whole steps and samples, runs that outlast their settling, and nothing faster than what samples it."""
        yield from clock_problems("fine_pointing", self.rate_hz, self.delay_s, self.plant_step_s)
        yield from self._run_problems()
        yield from self._sensor_problems()
        yield from self._spectrum_problems()
        if not self.reference_filter_hz < self.rate_hz / 2:
            half, better = format_quantity(self.rate_hz / 2, "Hz"), format_quantity(self.rate_hz / 5, "Hz")
            advice = f'reference_filter = "{better}" would do'
            yield Problem("reference_filter", f"is not below half of fine_pointing.rate ({half})", advice)

    def _run_problems(self) -> Iterator[Problem]:
        samples, settling = self.duration_s * self.rate_hz, self.settle_s * self.rate_hz
        if not samples <= MOST_RUN_SAMPLES:
            longest = format_quantity(0.5 * MOST_RUN_SAMPLES / self.rate_hz, "s")
            reason = f"is more than {MOST_RUN_SAMPLES} samples of fine_pointing.rate"
            yield Problem("duration", reason, f'more runs that are shorter: duration = "{longest}" would do')
        elif not settling < samples:
            given, better = format_quantity(self.duration_s, "s"), format_quantity(0.2 * self.duration_s, "s")
            yield Problem("settle", f"is not less than duration ({given})", f'settle = "{better}" would do')
        elif round(settling) >= round(samples):
            better = format_limit(self.settle_s + 2000.0 / self.rate_hz, "s", least=True)
            reason = "leaves no control sample behind settle"
            yield Problem("duration", reason, f'a longer run: duration = "{better}" would do')

    def _sensor_problems(self) -> Iterator[Problem]:
        rate_hz, delay_s = self.optical_sensor.rate_hz, self.optical_sensor.delay_s
        control = format_quantity(self.rate_hz, "Hz", 12)
        ratio = self.rate_hz / rate_hz
        if ratio < 1.0 - STEP_TOLERANCE:
            reason = f"is above fine_pointing.rate ({control}): the controller would miss some of its readings"
            yield Problem("optical_sensor.rate", reason, f'rate = "{control}" would do')
        elif ratio > MOST_STEPS:
            reason = f"is less than fine_pointing.rate ({control}) divided by {MOST_STEPS}"
            yield Problem("optical_sensor.rate", reason, f'a faster sensor: rate = "{control}" would do')
        elif abs(round(ratio) - ratio) > STEP_TOLERANCE * ratio:
            rates = (self.rate_hz / math.floor(ratio), self.rate_hz / math.ceil(ratio))
            better = format_quantity(min(rates, key=lambda rate: abs(rate - rate_hz)), "Hz", 12)
            reason = f"does not divide fine_pointing.rate ({control}): readings would fall between control samples"
            yield Problem("optical_sensor.rate", reason, f'rate = "{better}" would do')
        if not delay_s <= MOST_STEPS * self.plant_step_s:
            reason = f"is more than {MOST_STEPS} times fine_pointing.plant_step"
            yield Problem("optical_sensor.delay", reason, 'a shorter delay: delay = "0 us" would do')
        else:
            yield from _delay_problems("optical_sensor.delay", delay_s, self.plant_step_s)

    def _spectrum_problems(self) -> Iterator[Problem]:
        """What the plant's steps cannot carry: half of their rate and above."""
        limit_hz = 0.5 / self.plant_step_s
        limit, better = format_quantity(limit_hz, "Hz"), format_quantity(limit_hz / 5, "Hz")
        above = f"not below half of 1 / fine_pointing.plant_step ({limit})"
        corners = {"vibration.corner": self.vibration.corner_hz, "body.bandwidth": self.body.bandwidth_hz}
        for key, corner_hz in corners.items():
            if corner_hz is not None and not corner_hz < limit_hz:
                yield Problem(key, f"is {above}", f'{key.partition(".")[2]} = "{better}" would do')
        if self.vibration.edges_hz and not self.vibration.edges_hz[-1] < limit_hz:
            highest = format_quantity(self.vibration.edges_hz[-1], "Hz")
            advice = f"edges that end below {limit}, at {better} for example"
            yield Problem("vibration.edges", f"reaches {highest}, {above}", advice)
        if self.wheels and not self.wheels.speed_hz * max(self.wheels.harmonics) < limit_hz:
            harmonic = max(self.wheels.harmonics)
            line = format_quantity(self.wheels.speed_hz * harmonic, "Hz")
            slower = format_quantity(limit_hz / harmonic / 5, "Hz")
            reason = f"puts harmonic {harmonic:g} at {line}, {above}"
            yield Problem("wheels.speed", reason, f'speed = "{slower}" would do, or without that harmonic')


# -------------------------------------------------------------------------------------------------------------- clocks
def clock_problems(table: str, rate_hz: float, delay_s: float, plant_step_s: float) -> Iterator[Problem]:
    """Why the control period and the delay of a table are not both whole numbers of its plant steps.

    Args:
        table: Name of the table, for the message.
        rate_hz: Control rate, in Hz.
        delay_s: Delay of the loop, in s.
        plant_step_s: Step of the simulated plant, in s.
    """
    step, period = plant_step_s, 1.0 / rate_hz
    if not max(period, delay_s) <= MOST_STEPS * step:
        reason = f"goes more than {MOST_STEPS} times into the control period or the delay"
        yield Problem("plant_step", reason, f"a step nearer to 1 / {table}.rate")
        return
    steps = max(round(period / step), 1)
    if abs(steps * step - period) > STEP_TOLERANCE * period:
        shown, better = format_quantity(period, "s", 9), format_quantity(period / steps, "s", 12)
        reason = f"does not divide the control period 1 / {table}.rate ({shown})"
        yield Problem("plant_step", reason, f'a whole fraction of it: plant_step = "{better}" would do')
    else:
        yield from _delay_problems("delay", delay_s, step)


def _delay_problems(key: str, delay_s: float, plant_step_s: float) -> Iterator[Problem]:
    steps = round(delay_s / plant_step_s)
    if abs(steps * plant_step_s - delay_s) > STEP_TOLERANCE * delay_s:
        better = format_quantity(steps * plant_step_s, "s", 12)
        yield Problem(key, "is no whole number of plant_step", f'delay = "{better}" would do')
