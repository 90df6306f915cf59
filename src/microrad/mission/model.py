"""The mission as frozen, checked data: the keys of a mission file, their units and bounds, and what must fit together.

Every quantity is text with a unit in the file (`transmit_power = "5 W"`) and an SI float with the unit in its name here
(`transmit_power_w`). No quantity of the mission has a default. `file` reads the file and reports the faults.
"""

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Annotated, Any, Literal

from pydantic import Field

from microrad.core.units import format_input, format_limit, format_quantity
from microrad.mission.fields import Problem, Quantity, Several, Share, Table
from microrad.mission.ground import GroundPath, ground_fits, path_of, range_of
from microrad.mission.tables.acquisition import Acquisition
from microrad.mission.tables.channel import Channel
from microrad.mission.tables.error_budget import ErrorBudget
from microrad.mission.tables.fine_pointing import FinePointing, clock_problems
from microrad.mission.tables.link import (
    Beacon,
    Beam,
    Communication,
    LinkConventions,
    LinkRequirement,
    Terminals,
    divergence_fits,
    obscuration_fits,
    pattern_fits,
    strehl_fits,
)
from microrad.mission.tables.mirror import (
    ANGLE_MOST,
    Angle,
    DurationOrZero,
    Frequency,
    Mirror,
    MirrorGain,
    Name,
    Rate,
    Voltage,
)
from microrad.mission.tables.operations import Constellation, Operations
from microrad.mission.tables.orbit import Orbits
from microrad.mission.tables.pointing import JitterTable, PointAhead, Pointing, point_ahead_rad

MOST_SAMPLES = 2_000_000
"""Control samples in a period of the scenario's sines beyond which a run would not fit into memory."""

_KINDS = ("paper", "assumption", "derived", "standard", "measured", "identified", "literature", "unknown")


@dataclass(frozen=True, slots=True)
class Source:
    """Where a value of the mission comes from: the line it stands on, its raw text and the comment behind it.

    `was` is the raw value that the comment was written for, where it has another one in front of it now.
    """

    line: int
    comment: str
    value: str = ""
    file: str = "mission file"
    was: str = ""

    @property
    def kind(self) -> str:
        """The word before the colon of the comment when it names a kind of source, such as "assumption", else ""."""
        word, colon, _ = self.comment.partition(":")
        return word if colon and word in _KINDS else ""

    @property
    def text(self) -> str:
        """The comment, or the place in the file where there is none or it speaks of another value."""
        place, was = f"{self.file}, line {self.line}", self.was.strip('"')
        if was:
            return f"{place}, in place of {was} ({self.comment})"
        return self.comment or place


def source_text(sources: Mapping[str, Source], *keys: str) -> str:
    """The sources of some keys as one text, each said once; "not stated" for a key without one.

    Args:
        sources: Where each value of the mission comes from, by its dotted key.
        *keys: The dotted keys asked for.
    """
    texts = [sources[key].text if key in sources else "not stated" for key in keys]
    return "; ".join(dict.fromkeys(texts))


AngleOrZero = Annotated[float, Quantity("rad", "urad", least=0.0, most=ANGLE_MOST)]
Duration = Annotated[float, Quantity("s", "us", above=0.0)]
Step = Annotated[float, Quantity("V", "mV", least=0.0)]
Frequencies = Annotated[tuple[float, ...], Several(Quantity("Hz", above=0.0, most=1e12), rising=True)]


class Conventions(LinkConventions):
    """How numbers are read that a source leaves ambiguous."""

    residual: Literal["per-axis", "radial"] = Field(
        description="per-axis: the simulated axis is the pointing error; radial: two equal axes, sqrt 2 more"
    )
    mirror_angle: Literal["line-of-sight", "optical", "mechanical"] = Field(
        description="optical: the beam's angle at the mirror, ahead of a telescope; mechanical is doubled by reflection"
    )


class Requirement(LinkRequirement):
    """What has to be met."""

    outage: Annotated[float, Share("")] = Field(description="share of the time that the required margin may be missed")
    residual_statistic: Literal["peak", "rms"] = Field(description="which number of the residual has to meet it")


class Amplifier(Table):
    """From the controller's output to the piezo: gain, then limits at the amplifier's output."""

    gain: Annotated[float, Quantity("", above=0.0)] = Field(description="volts at the mirror for one volt at the input")
    output_min_v: Voltage = Field(description="lowest voltage that it can give")
    output_max_v: Voltage = Field(description="highest voltage that it can give")
    bandwidth_hz: Frequency = Field(description="first-order corner")
    slew_v_s: Rate = Field(description="at the amplifier's output")

    def problems(self) -> Iterator[Problem]:
        """An output range that goes up."""
        if not self.output_min_v < self.output_max_v:
            low = format_input(self.output_min_v, "V")
            yield Problem("output_max", f"is not above output_min ({low})", f"a voltage above {low}")


class Control(Table):
    """The sampled loop. A resolution of "0 V" or "0 urad" is an ideal converter or sensor."""

    rate_hz: Frequency = Field(description="sample rate of the controller")
    delay_s: DurationOrZero = Field(description="from sampling to the changed output")
    plant_step_s: Duration = Field(description="step of the simulated plant")
    drive_resolution_v: Step = Field(description='one count; "0 V" is ideal')
    sensor_resolution_rad: AngleOrZero = Field(description='one count; "0 urad" is ideal')
    proportional_v_rad: Annotated[float, Quantity("V/rad", "V/mrad", least=0.0)] = Field(
        description="volts for an error of one radian"
    )
    integral_v_rad_s: Annotated[float, Quantity("V/(rad s)", "V/(mrad s)", least=0.0)] = Field(
        description="volts a second for an error of one radian"
    )
    derivative_v_s_rad: Annotated[float, Quantity("V s/rad", "V s/mrad", least=0.0)] = Field(
        description="volts for an error that grows by one radian a second"
    )
    derivative_filter_s: Duration = Field(description="time constant")
    for_mirror_gain_rad_v: MirrorGain = Field(
        description="for a mirror of another gain the gains are scaled to keep the loop gain"
    )

    def problems(self) -> Iterator[Problem]:
        """Control period and delay in whole plant steps."""
        return clock_problems("control", self.rate_hz, self.delay_s, self.plant_step_s)


class Scenario(Table):
    """The sines that the study runs."""

    amplitude_rad: Angle = Field(description="of the pointing reference")
    pid_frequencies_hz: Frequencies = Field(description="sines that are tracked under PID alone")
    inverse_frequencies_hz: Frequencies = Field(description="sines that are tracked under PID + inverse")
    loop_frequencies_hz: Frequencies = Field(description="of the hysteresis loops")
    loop_amplitude_v: Annotated[float, Quantity("V", above=0.0)] = Field(
        description="of the sine that the hysteresis loop is drawn with"
    )


def _bias_fits(mirror: Mirror, amplifier: Amplifier) -> Iterator[Problem]:
    low, high = amplifier.output_min_v / amplifier.gain, amplifier.output_max_v / amplifier.gain
    if not low <= mirror.bias_v <= high:
        span = f"{format_limit(low, 'V', least=True)} to {format_limit(high, 'V')}"
        reason = "is outside amplifier.output_min to amplifier.output_max divided by amplifier.gain"
        yield Problem("mirror.bias", reason, span)


def _frequencies_fit(control: Control, scenario: Scenario) -> Iterator[Problem]:
    half = format_limit(control.rate_hz / 2, "Hz")
    for name in ("pid_frequencies", "inverse_frequencies", "loop_frequencies"):
        lowest, highest = getattr(scenario, f"{name}_hz")[0], getattr(scenario, f"{name}_hz")[-1]
        slowest = control.rate_hz / MOST_SAMPLES
        if lowest < slowest:
            reason = f"begins at {format_quantity(lowest, 'Hz')}, a period of over {MOST_SAMPLES} control samples"
            advice = f"frequencies of at least {format_limit(slowest, 'Hz', least=True)}"
            yield Problem(f"scenario.{name}", reason, advice)
        if highest >= control.rate_hz / 2:
            reason = f"reaches {format_quantity(highest, 'Hz')}, but half of control.rate is {half}"
            yield Problem(f"scenario.{name}", reason, f"frequencies below {half}")


def _cone_fits(pointing: Pointing | None, beacon: Beacon | None) -> Iterator[Problem]:
    """A beacon has to cover errors that are stated."""
    if pointing is None and beacon is not None:
        reason = "is missing, and the cone of the beacon is judged by its errors"
        yield Problem("pointing", reason, "the table [pointing] with its lines, or no beacon")


def _outage_given(jitter: JitterTable | None, requirement: LinkRequirement) -> Iterator[Problem]:
    """Under a jitter the margin is judged at an outage."""
    if jitter is not None and requirement.outage is None:
        reason = "is missing, and the margin under the table jitter is the one that is kept but for it"
        yield Problem("requirement.outage", reason, "a share of the time, outage = 0.003 for 0.3 %")


def _coupling_fits(
    terminals: Terminals, communication: Communication, requirement: LinkRequirement
) -> Iterator[Problem]:
    """A fibre whose cone the telescope's fills, and an outage for a receiver that points at random."""
    c = communication.coupling
    if c is None:
        return
    if c.numerical_aperture is not None and c.focal_length_m is not None:
        cone = 2.0 * c.focal_length_m * math.tan(math.asin(c.numerical_aperture))
        if cone <= (terminals.geo_obscuration or 0.0) * terminals.geo_aperture_m:
            size = format_quantity(cone, "m")
            reason = f"leaves {size} of the aperture, no more than terminals.geo_obscuration stops"
            yield Problem("communication.coupling.numerical_aperture", reason, "a larger one, or a longer focal_length")
    if c.angular_error_rad and c.focal_length_m is not None:
        # truncation times shift of the mode in the aperture; that of the best mode is no more than without obscuration
        given = not math.isnan(c.mode_radius_m or math.nan)
        of_aperture = math.pi * (c.mode_radius_m or 0.0) / communication.wavelength_m
        off = of_aperture if given else 1.121 * 2.0 * c.focal_length_m / terminals.geo_aperture_m
        most = math.atan(8.0 / off)
        if c.angular_error_rad > most:
            limit = format_limit(most, "rad")
            reason = f"turns the fibre's mode out of the aperture: beyond {limit} it takes no light to speak of"
            yield Problem("communication.coupling.angular_error", reason, f"at most {limit}")
    if c.is_random and requirement.outage is None:
        reason = "is missing, and the margin under the receiver's jitter is the one that is kept but for it"
        yield Problem("requirement.outage", reason, "a share of the time, outage = 0.003 for 0.3 %")


def _point_ahead_fits(point_ahead: PointAhead | None, fine: FinePointing | None) -> Iterator[Problem]:
    """One point-ahead: the mirror's largest is that of the largest velocity."""
    if point_ahead is None or fine is None:
        return
    angle = point_ahead_rad(point_ahead.transverse_velocity_m_s)
    if abs(fine.reference.point_ahead_rad - angle) > 0.02 * angle:
        shown = format_quantity(angle, "rad", 3)
        reason = f"is not 2 v / c of point_ahead.transverse_velocity ({shown})"
        yield Problem("fine_pointing.reference.point_ahead", reason, f'point_ahead = "{shown}" would do')


def _loop_there(error_budget: ErrorBudget | None, fine: FinePointing | None) -> Iterator[Problem]:
    """What a loop leaves needs a loop."""
    if error_budget is not None and error_budget.with_loop and fine is None:
        reason = "is true, and the mission has no table fine_pointing"
        yield Problem(
            "error_budget.with_loop", reason, "the table [fine_pointing], which microrad init writes, or false"
        )


def _needs_orbit(name: str) -> Callable[..., Iterator[Problem]]:
    """A table that means nothing without the orbits."""

    def check(orbit: Orbits | None, table: Table | None) -> Iterator[Problem]:
        if table is not None and orbit is None:
            yield Problem(name, "stands without the table orbit", "the table [orbit], which microrad init writes")

    return check


def _needs_operations(operations: Operations | None, constellation: Constellation | None) -> Iterator[Problem]:
    """A constellation has its rates and its acquisition from the operations."""
    if constellation is not None and operations is None:
        reason = "stands without the table operations"
        yield Problem("constellation", reason, "the table [operations], which microrad init writes")


def _both_fly(
    orbit: Orbits | None, operations: Operations | None, constellation: Constellation | None
) -> Iterator[Problem]:
    """What only terminals that fly can have: relays in slots, and of our own stations below it."""
    if orbit is None or not orbit.station:
        return
    own = orbit.station == "leo"
    beside = {f"operations.{name}": getattr(operations, name) for name in _BELOW} if own and operations else {}
    for key, table in {**beside, "constellation": constellation}.items():
        if table is not None:
            reason = f'stands beside orbit.{orbit.station} of kind "station", and means a satellite there'
            other = "or the station as orbit.geo and the satellite as orbit.leo" if own else "or a relay as orbit.geo"
            yield Problem(key, reason, f"the table removed, {other}")


def _scan_there(operations: Operations | None, acquisition: Acquisition | None) -> Iterator[Problem]:
    """A scan that the mission has."""
    there = acquisition is not None and acquisition.scan is not None
    if operations is None or operations.acquisition != "scan" or there:
        return
    reason = 'is "scan", and the mission has no table acquisition.scan'
    yield Problem("operations.acquisition", reason, 'the table [acquisition.scan], or "wide beacon"')


_BELOW = ("downlink", "optical")
"""Ways from a satellite straight to the ground, tables of the operations."""

Relation = tuple[tuple[str, ...], Callable[..., Iterator[Problem]]]

LINK_RELATIONS: tuple[Relation, ...] = (
    *((("conventions", name), strehl_fits(name)) for name in ("beacon", "answer", "communication")),
    (("conventions", "terminals", "beacon"), divergence_fits("beacon", "leo")),
    (("conventions", "terminals", "answer"), divergence_fits("answer", "geo")),
    (("conventions", "communication"), pattern_fits),
    (("terminals", "communication"), obscuration_fits),
    (("pointing", "beacon"), _cone_fits),
    (("jitter", "requirement"), _outage_given),
    (("terminals", "communication", "requirement"), _coupling_fits),
    (("orbit", "channel", "communication", "beacon", "answer", "requirement"), ground_fits),
    (("orbit", "operations"), _needs_orbit("operations")),
    (("orbit", "constellation"), _needs_orbit("constellation")),
    (("operations", "acquisition"), _scan_there),
    (("operations", "constellation"), _needs_operations),
    (("orbit", "operations", "constellation"), _both_fly),
)
"""What has to fit between tables of the link: their names, and a check that takes them and yields what does not."""

RELATIONS: tuple[Relation, ...] = (
    *LINK_RELATIONS,
    (("mirror", "amplifier"), _bias_fits),
    (("control", "scenario"), _frequencies_fit),
    (("point_ahead", "fine_pointing"), _point_ahead_fits),
    (("error_budget", "fine_pointing"), _loop_there),
)
"""What has to fit between tables of a whole mission."""


class LinkMission(Table):
    """What a link budget needs; a mission whose tables on mirror and loop are left out."""

    name: Name = Field(description="what the report calls the mission")
    pointing: Pointing | None = None
    terminals: Terminals
    conventions: LinkConventions
    beacon: Beacon | None = None
    answer: Beacon | None = None
    communication: Communication
    requirement: LinkRequirement
    channel: Channel | None = None
    jitter: JitterTable | None = None
    point_ahead: PointAhead | None = None
    error_budget: ErrorBudget | None = None
    acquisition: Acquisition | None = None
    orbit: Orbits | None = None
    operations: Operations | None = None
    constellation: Constellation | None = None

    @property
    def path(self) -> GroundPath | None:
        """The path of its links through the air; None where there is no air."""
        return path_of(self.orbit, self.channel)

    def range_m(self, beam: Beam) -> float:
        """Distance (m) of the terminals for one of its links: as that table says, or as the path has it."""
        return range_of(beam, self.path)

    @classmethod
    def relations(cls) -> tuple[Relation, ...]:
        """What has to fit between its tables."""
        return LINK_RELATIONS

    def problems(self) -> Iterator[Problem]:
        """What does not fit between tables."""
        for names, check in self.relations():
            yield from check(*(getattr(self, name) for name in names))


class Mission(LinkMission):
    """Everything that a study needs."""

    pointing: Pointing
    conventions: Conventions
    beacon: Beacon
    answer: Beacon
    requirement: Requirement
    mirror: Mirror
    amplifier: Amplifier
    control: Control
    scenario: Scenario
    fine_pointing: FinePointing | None = None

    @property
    def loop_in_turbulence(self) -> bool:
        """Whether the light that its fine-pointing loop tracks comes down through turbulent air: to a station."""
        turbulent = self.channel is not None and self.channel.turbulence is not None
        return turbulent and self.fine_pointing is not None and self.path is not None and self.path.station == "leo"

    @classmethod
    def relations(cls) -> tuple[Relation, ...]:
        """What has to fit between its tables."""
        return RELATIONS


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
