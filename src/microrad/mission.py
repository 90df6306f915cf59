"""The mission as frozen, checked data: the keys of a mission file, their units and bounds, and what must fit together.

Every quantity is text with a unit in the file (`transmit_power = "5 W"`) and an SI float with the unit in its name here
(`transmit_power_w`). No quantity of the mission has a default. `missionfile` reads the file and reports the faults.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Annotated, Any, Literal

from pydantic import Field

from microrad.fields import Problem, Quantity, Several, Table
from microrad.fine_pointing_table import FinePointing, clock_problems
from microrad.mirror_table import ANGLE_MOST, Angle, DurationOrZero, Frequency, Mirror, MirrorGain, Name, Rate, Voltage
from microrad.units import format_quantity

MOST_SAMPLES = 2_000_000
"""Control samples in a period of the scenario's sines beyond which a run would not fit into memory."""

_KINDS = ("paper", "assumption", "standard", "measured", "identified")


@dataclass(frozen=True, slots=True)
class Source:
    """Where a value of the mission comes from: the line it stands on, its raw text and the comment behind it."""

    line: int
    comment: str
    value: str = ""
    file: str = "mission file"

    @property
    def kind(self) -> str:
        """The word before the colon of the comment when it names a kind of source, such as "assumption", else ""."""
        word, colon, _ = self.comment.partition(":")
        return word if colon and word in _KINDS else ""

    @property
    def text(self) -> str:
        """The comment, or the place in the file when there is none."""
        return self.comment or f"{self.file}, line {self.line}"


def source_text(sources: Mapping[str, Source], *keys: str) -> str:
    """The sources of some keys as one text, each said once; "not stated" for a key without one."""
    texts = [sources[key].text if key in sources else "not stated" for key in keys]
    return "; ".join(dict.fromkeys(texts))


AngleOrZero = Annotated[float, Quantity("rad", least=0.0, most=ANGLE_MOST)]
# the upper bounds are no limits of technology: they catch a wrong prefix, "5 km" for an aperture of 5 cm
Power = Annotated[float, Quantity("W", above=0.0, most=1e6)]
Threshold = Annotated[float, Quantity("W", "pW", above=0.0, most=1e6)]
Aperture = Annotated[float, Quantity("m", "cm", above=0.0, most=100.0)]
Wavelength = Annotated[float, Quantity("m", "um", least=1e-8, most=1e-2)]
Distance = Annotated[float, Quantity("m", "km", above=0.0, most=1e13)]
Loss = Annotated[float, Quantity("dB", least=0.0)]
Strehl = Annotated[float, Quantity("", least=0.0)]
Duration = Annotated[float, Quantity("s", "us", above=0.0)]
Step = Annotated[float, Quantity("V", "mV", least=0.0)]
Frequencies = Annotated[tuple[float, ...], Several(Quantity("Hz", above=0.0, most=1e12), rising=True)]


class Pointing(Table):
    """Open-loop pointing: the errors that the beacon has to cover, each as a half width about the line of sight."""

    body_pointing_rad: AngleOrZero = Field(alias="body_pointing", description="attitude control error of the body")
    orbit_knowledge_rad: AngleOrZero = Field(alias="orbit_knowledge", description="direction error from the two orbits")
    misalignment_rad: AngleOrZero = Field(alias="misalignment", description="calibration and environmental alignment")


class Terminals(Table):
    """Diameters of the two optical terminals."""

    leo_aperture_m: Aperture = Field(alias="leo_aperture")
    geo_aperture_m: Aperture = Field(alias="geo_aperture")


class Conventions(Table):
    """How numbers are read that a source leaves ambiguous."""

    pointing_loss: Literal["gaussian", "gain"] = Field(
        description="gaussian: beam with 1/e2 radius D/2 at the aperture; gain: exp(-G theta^2)"
    )
    strehl: Literal["decibel", "ratio"] = Field(description="decibel: a loss in dB; ratio: a number up to 1")
    divergence: Literal["full-1/e2", "half-1/e2"] = Field(description="which angle a beam's divergence is")
    residual: Literal["per-axis", "radial"] = Field(
        description="per-axis: the simulated axis is the pointing error; radial: two equal axes, sqrt 2 more"
    )
    mirror_angle: Literal["line-of-sight", "optical", "mechanical"] = Field(
        description="optical: the beam's angle at the mirror, ahead of a telescope; mechanical is doubled by reflection"
    )


class Beam(Table):
    """What a link has whatever its beam: power, wavelength, quality, distance and losses (all losses positive)."""

    transmit_power_w: Power = Field(alias="transmit_power", description="optical power before the optics")
    wavelength_m: Wavelength = Field(alias="wavelength")
    strehl: Strehl = Field(description="decibel or ratio as conventions.strehl says")
    pointing_error_rad: AngleOrZero = Field(alias="pointing_error", description="off the line of sight, radial")
    distance_m: Distance = Field(alias="distance")
    transmit_optics_loss_db: Loss = Field(alias="transmit_optics_loss")
    receive_optics_loss_db: Loss = Field(alias="receive_optics_loss")


class Beacon(Beam):
    """A wide Gaussian beam to be found by: the beacon, and the answer to it."""

    divergence_rad: Angle = Field(alias="divergence", description="full or half angle as conventions.divergence says")
    required_power_w: Threshold = Field(alias="required_power", description="power that the sensor needs")


class Communication(Beam):
    """The data link, diffraction-limited by its aperture."""

    data_rate_bit_s: Annotated[float, Quantity("bit/s", above=0.0)] = Field(alias="data_rate")
    tracking_split_loss_db: Loss = Field(alias="tracking_split_loss", description="light for the tracking sensor")
    implementation_loss_db: Loss = Field(alias="implementation_loss", description="receiver against its sensitivity")
    receiver_sensitivity_photon_bit: Annotated[float, Quantity("photon/bit", above=0.0)] = Field(
        alias="receiver_sensitivity"
    )


class Requirement(Table):
    """What has to be met."""

    margin_db: Loss = Field(alias="margin", description="margin of the communication link")
    pointing_error_rad: Angle = Field(alias="pointing_error", description="residual that the fine pointing may leave")
    residual_statistic: Literal["peak", "rms"] = Field(description="which number of the residual has to meet it")


class Amplifier(Table):
    """From the controller's output to the piezo: gain, then limits at the amplifier's output."""

    gain: Annotated[float, Quantity("", above=0.0)]
    output_min_v: Voltage = Field(alias="output_min")
    output_max_v: Voltage = Field(alias="output_max")
    bandwidth_hz: Frequency = Field(alias="bandwidth", description="first-order corner")
    slew_v_s: Rate = Field(alias="slew", description="at the amplifier's output")

    def problems(self) -> Iterator[Problem]:
        """An output range that goes up."""
        if not self.output_min_v < self.output_max_v:
            low = format_quantity(self.output_min_v, "V")
            yield Problem("output_max", f"is not above output_min ({low})", f"a voltage above {low}")


class Control(Table):
    """The sampled loop. A resolution of "0 V" or "0 urad" is an ideal converter or sensor."""

    rate_hz: Frequency = Field(alias="rate", description="sample rate of the controller")
    delay_s: DurationOrZero = Field(alias="delay", description="from sampling to the changed output")
    plant_step_s: Duration = Field(alias="plant_step", description="step of the simulated plant")
    drive_resolution_v: Step = Field(alias="drive_resolution", description='one count; "0 V" is ideal')
    sensor_resolution_rad: AngleOrZero = Field(alias="sensor_resolution", description='one count; "0 urad" is ideal')
    proportional_v_rad: Annotated[float, Quantity("V/rad", "V/mrad", least=0.0)] = Field(alias="proportional")
    integral_v_rad_s: Annotated[float, Quantity("V/(rad s)", "V/(mrad s)", least=0.0)] = Field(alias="integral")
    derivative_v_s_rad: Annotated[float, Quantity("V s/rad", "V s/mrad", least=0.0)] = Field(alias="derivative")
    derivative_filter_s: Duration = Field(alias="derivative_filter", description="time constant")
    for_mirror_gain_rad_v: MirrorGain = Field(
        alias="for_mirror_gain",
        description="for a mirror of another gain the gains are scaled to keep the loop gain",
    )

    def problems(self) -> Iterator[Problem]:
        """Control period and delay in whole plant steps."""
        return clock_problems("control", self.rate_hz, self.delay_s, self.plant_step_s)


class Scenario(Table):
    """The sines that the study runs."""

    amplitude_rad: Angle = Field(alias="amplitude", description="of the pointing reference")
    pid_frequencies_hz: Frequencies = Field(alias="pid_frequencies")
    inverse_frequencies_hz: Frequencies = Field(alias="inverse_frequencies")
    loop_frequencies_hz: Frequencies = Field(alias="loop_frequencies", description="of the hysteresis loops")
    loop_amplitude_v: Annotated[float, Quantity("V", above=0.0)] = Field(alias="loop_amplitude")


def _strehl_fits(name: str) -> Callable[..., Iterator[Problem]]:
    def check(conventions: Conventions, beam: Beam) -> Iterator[Problem]:
        if conventions.strehl == "ratio" and not 0.0 < beam.strehl <= 1.0:
            reason = f'is no ratio, but conventions.strehl = "ratio" ({beam.strehl:g})'
            yield Problem(f"{name}.strehl", reason, 'above 0 and at most 1, or conventions.strehl = "decibel"')

    return check


def _bias_fits(mirror: Mirror, amplifier: Amplifier) -> Iterator[Problem]:
    low, high = amplifier.output_min_v / amplifier.gain, amplifier.output_max_v / amplifier.gain
    if not low <= mirror.bias_v <= high:
        span = f"{format_quantity(low, 'V')} to {format_quantity(high, 'V')}"
        reason = "is outside amplifier.output_min to amplifier.output_max divided by amplifier.gain"
        yield Problem("mirror.bias", reason, span)


def _frequencies_fit(control: Control, scenario: Scenario) -> Iterator[Problem]:
    half = format_quantity(control.rate_hz / 2, "Hz")
    for name in ("pid_frequencies", "inverse_frequencies", "loop_frequencies"):
        lowest, highest = getattr(scenario, f"{name}_hz")[0], getattr(scenario, f"{name}_hz")[-1]
        slowest = control.rate_hz / MOST_SAMPLES
        if lowest < slowest:
            reason = f"begins at {format_quantity(lowest, 'Hz')}, a period of over {MOST_SAMPLES} control samples"
            yield Problem(f"scenario.{name}", reason, f"frequencies of at least {format_quantity(slowest, 'Hz')}")
        if highest >= control.rate_hz / 2:
            reason = f"reaches {format_quantity(highest, 'Hz')}, but half of control.rate is {half}"
            yield Problem(f"scenario.{name}", reason, f"frequencies below {half}")


RELATIONS: tuple[tuple[tuple[str, ...], Callable[..., Iterator[Problem]]], ...] = (
    *((("conventions", name), _strehl_fits(name)) for name in ("beacon", "answer", "communication")),
    (("mirror", "amplifier"), _bias_fits),
    (("control", "scenario"), _frequencies_fit),
)
"""What has to fit between tables: their names, and a check that takes them and yields what does not."""


class Mission(Table):
    """Everything that a study needs."""

    name: Name
    pointing: Pointing
    terminals: Terminals
    conventions: Conventions
    beacon: Beacon
    answer: Beacon
    communication: Communication
    requirement: Requirement
    mirror: Mirror
    amplifier: Amplifier
    control: Control
    scenario: Scenario
    fine_pointing: FinePointing | None = None

    def problems(self) -> Iterator[Problem]:
        """What does not fit between tables."""
        for names, check in RELATIONS:
            yield from check(*(getattr(self, name) for name in names))


def half_angle_rad(divergence_rad: float, convention: str) -> float:
    """Half angle at 1/e2 of intensity of a beam whose divergence is given as "full-1/e2" or "half-1/e2"."""
    return divergence_rad / 2 if convention == "full-1/e2" else divergence_rad


def mission_schema() -> dict[str, Any]:
    """JSON schema of a mission file, for editors; each quantity names its SI unit in `x-si-unit`."""
    schema = Mission.model_json_schema(by_alias=True)
    schema["$schema"] = "https://json-schema.org/draft/2020-12/schema"
    other_file = {
        "type": "object",
        "properties": {"file": {"type": "string", "description": "mirror file, seen from the mission file"}},
        "required": ["file"],
        "additionalProperties": False,
    }
    schema["properties"]["mirror"] = {"anyOf": [schema["properties"]["mirror"], other_file]}
    return schema
