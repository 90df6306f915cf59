"""The table of a mission about acquisition: how long each step of finding the partner takes, and the scan instead."""

from collections.abc import Iterator
from typing import Annotated, Literal

from pydantic import Field

from microrad.mission.fields import Problem, Quantity, Share, Table, Whole
from microrad.mission.tables.mirror import ANGLE_MOST, Angle, Frequency

Seconds = Annotated[float, Quantity("s", "s", least=0.0, most=1e6)]
Frame = Annotated[float, Quantity("s", "ms", above=0.0, most=1e6)]
AngleOrZero = Annotated[float, Quantity("rad", "urad", least=0.0, most=ANGLE_MOST)]

LEAST_OVERLAP = 0.001
"""Overlap below which the tracks of a spiral or a raster leave no time to detect what lies between two of them."""


class TrackingSensor(Table):
    """Quad cell of the satellite's own terminal, which measures the answer; its spot is that of the whole aperture."""

    responsivity_a_w: Annotated[float, Quantity("A/W", above=0.0, most=1e3)] = Field(
        description="current for a watt of light"
    )
    background_power_w: Annotated[float, Quantity("W", "pW", least=0.0, most=1e6)] = Field(
        description="on all four cells together"
    )
    dark_current_a: Annotated[float, Quantity("A", "nA", least=0.0, most=1.0)] = Field(description="of one of them")
    thermal_noise_a_sqrt_hz: Annotated[float, Quantity("A/sqrt(Hz)", "pA/sqrt(Hz)", least=0.0, most=1e-3)] = Field(
        description="of one amplifier, one-sided, referred to its input"
    )
    rate_hz: Frequency = Field(description="readings in a second")


class Scan(Table):
    """A narrow beam led over the uncertainty in place of the wide beacon."""

    pattern: Literal["spiral", "raster", "step-stare"] = Field(
        description="how the beam searches: from the middle outwards, row by row, or from spot to spot"
    )
    beam_radius_rad: Angle = Field(
        description="off axis, where the partner still sees it; the beam itself is no narrower than diffraction"
    )
    overlap: Annotated[float, Quantity("", least=0.0, most=0.95)] = Field(
        description="of neighbouring tracks, share of the beam's diameter"
    )
    coverage: Annotated[float, Share("")] = Field(description="probability that the partner is within what is scanned")
    detection_s: Frame = Field(description="time on the partner that its sensor needs")
    turn_s: Seconds = Field(description="raster: at the end of a row; step-stare: from spot to spot")
    jitter_rms_rad: AngleOrZero = Field(alias="jitter", description="of the scanning beam, rms per axis")

    def problems(self) -> Iterator[Problem]:
        """Tracks that overlap; dwells need not."""
        if self.pattern != "step-stare" and self.overlap < LEAST_OVERLAP:
            reason = (
                f'is {self.overlap:g}: between two tracks of pattern = "{self.pattern}" a target is seen for no time'
            )
            expected = f'at least {LEAST_OVERLAP:g}; overlap = 0.25 or pattern = "step-stare" would do'
            yield Problem("overlap", reason, expected)


class Acquisition(Table):
    """The paper's sequence: wide beacon, detection, narrow answer, measurement, narrow beam back, lock."""

    settle_s: Seconds = Field(description="body turned to the predicted direction")
    detection_s: Frame = Field(description="of the beacon by the partner, one frame")
    detection_probability: Annotated[float, Share("")] = Field(
        description="in a frame, at the power that the sensor needs"
    )
    detection_frames: Annotated[int, Whole("", least=1, most=100_000)] = Field(
        description="frames that the partner waits for the beacon"
    )
    response_s: Seconds = Field(description="partner turned, its narrow answer on")
    measurement_s: Frame = Field(description="of the answer's direction")
    steering_s: Seconds = Field(description="own mirror turned to the measured direction")
    lock_s: Seconds = Field(description="both loops settled on each other's beam")
    lock_probability: Annotated[float, Share("")] = Field(description="of each loop, once its beam arrives")
    pointing_sigmas: Annotated[float, Quantity("", above=0.0, most=100.0)] = Field(
        description="standard deviations per axis in answer.pointing_error"
    )
    attempts: Annotated[int, Whole("", least=1, most=1000)] = Field(description="before the contact is given up")
    runs: Annotated[int, Whole("", least=100, most=10_000_000)] = Field(description="simulated acquisitions")
    seed: Annotated[int, Whole("", least=0, most=2**63 - 1)] = Field(
        description="of the random numbers of the simulated acquisitions"
    )
    sensor: TrackingSensor | None = None
    scan: Scan | None = None
