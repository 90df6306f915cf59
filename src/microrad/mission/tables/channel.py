"""The table of a mission about the air between a station on the ground and a satellite."""

import math
from collections.abc import Iterator
from typing import Annotated, Literal

from pydantic import Field

from microrad.mission.fields import Problem, Quantity, Table, Whole
from microrad.mission.tables.mirror import ANGLE_MOST

LOWEST_ELEVATION_RAD = math.radians(10.0)
"""Elevation below which a plane-parallel atmosphere is no model of the path."""

Wander = Literal["dios-2004", "itu-r-p1622", "andrews-phillips-2005"]
"""Which constant the beam's wander has: 2.07, 3.43 or 7.25; the literature does not agree."""
Tilt = Literal["zernike", "gradient"]
"""Which angle of arrival a sensor sees: that of the plane that fits best, or the mean of the slopes (of a centroid)."""

_Speed = Annotated[float, Quantity("m/s", "m/s", least=0.0, most=200.0)]
_Height = Annotated[float, Quantity("m", "km", least=0.0, most=30e3)]


class WindTable(Table):
    """Wind across the path over height: ground + jet exp(-((h - peak) / width)^2), Bufton's."""

    ground_m_s: _Speed = Field(description="at the ground")
    jet_m_s: _Speed = Field(description="of the jet stream, above that at the ground")
    peak_m: _Height = Field(description="height of the jet stream above the ground")
    width_m: Annotated[float, Quantity("m", "km", above=0.0, most=30e3)] = Field(
        description="of the jet stream, at 1/e of its speed"
    )


class TurbulenceTable(Table):
    """Turbulence above the station by the profile of Hufnagel and Valley, with conventions that sources leave open."""

    ground_strength: Annotated[float, Quantity("", least=0.0, most=1e-10)] = Field(
        description="Cn2 at the ground in m^(-2/3), falling to 1/e in 100 m; 1.7e-14 is that of the profile 5/7"
    )
    wind_rms_m_s: _Speed | None = Field(
        default=None, description="root mean square from 5 to 20 km; 21 m/s is that of the profile 5/7"
    )
    wind: WindTable | None = Field(default=None, description="in place of wind_rms, which follows from it")
    fades: Literal["log-normal", "gamma-gamma"] = Field(
        description="law of the power at one scintillation index; gamma-gamma has the deeper fades"
    )
    wander: Wander = Field(description="constant of the uplink's beam wander: 2.07, 3.43 or 7.25")
    tilt: Tilt = Field(
        description="angle of arrival: of the plane that fits best, or the mean of the slopes, as a centroid has it"
    )
    corrected_modes: Annotated[int, Whole("", least=0, most=1000)] = Field(
        description="Zernike modes, piston among them, that adaptive optics at the station takes out; 3 is tip and tilt"
    )

    def problems(self) -> Iterator[Problem]:
        """A wind said once."""
        if self.wind_rms_m_s is None and self.wind is None:
            yield Problem("wind_rms", "is missing, and so is the table wind", 'wind_rms = "21 m/s" would do')
        if self.wind_rms_m_s is not None and self.wind is not None:
            yield Problem("wind_rms", "stands beside the table wind, of which it follows", "one of the two removed")
        if self.corrected_modes in (1, 2):
            advice = "0 without adaptive optics, 3 for tip and tilt, or more"
            yield Problem("corrected_modes", f"is {self.corrected_modes}: piston, or a tilt about one axis", advice)


class Channel(Table):
    """A path through a cloudless sky. Clouds and scattering into the receiver are outside; absent: vacuum."""

    zenith_transmission: Annotated[float, Quantity("", above=0.0, most=1.0)] | None = Field(
        default=None, description="of the clear atmosphere straight up, at the links' wavelength"
    )
    aerosol_depth: Annotated[float, Quantity("", least=0.0, most=5.0)] | None = Field(
        default=None, description="in place of zenith_transmission: optical depth of haze to the zenith at 1 um"
    )
    angstrom_exponent: Annotated[float, Quantity("", least=-1.0, most=4.0)] | None = Field(
        default=None, description="of that depth over wavelength; 1.3 is usual over land"
    )
    absorption_db: Annotated[float, Quantity("dB", least=0.0)] | None = Field(
        default=None, description="by molecules to the zenith, in the window that the wavelength lies in"
    )
    elevation_rad: Annotated[float, Quantity("rad", "deg", least=LOWEST_ELEVATION_RAD, most=ANGLE_MOST)] | None = Field(
        default=None, description="of the satellite above the horizon, in a mission without the table orbit"
    )
    altitude_m: Annotated[float, Quantity("m", "km", least=1e5, most=1e9)] | None = Field(
        default=None, description="of the satellite, as that of an orbit; absent: each distance says how far it is"
    )
    station: Literal["leo", "geo"] | None = Field(
        default=None, description="which terminal stands on the ground, in a mission without the table orbit"
    )
    height_m: Annotated[float, Quantity("m", "m", least=-500.0, most=9000.0)] | None = Field(
        default=None, description="of the station above the sea, in a mission without the table orbit"
    )
    turbulence: TurbulenceTable | None = Field(default=None, description="absent: the air is still")

    def problems(self) -> Iterator[Problem]:
        """A transmission said one way."""
        made = {"aerosol_depth": "0.1", "angstrom_exponent": "1.3", "absorption": '"0.1 dB"'}
        given = {"aerosol_depth": self.aerosol_depth, "angstrom_exponent": self.angstrom_exponent}
        given["absorption"] = self.absorption_db
        for key, value in given.items():
            if self.zenith_transmission is not None and value is not None:
                yield Problem(key, "stands beside zenith_transmission, which holds it", "one of the two removed")
        if self.zenith_transmission is None and not any(value is not None for value in given.values()):
            advice = "zenith_transmission = 0.9 would do, or aerosol_depth, angstrom_exponent and absorption"
            yield Problem("zenith_transmission", "is missing, and so is what it follows from", advice)
        elif self.zenith_transmission is None:
            for key, value in given.items():
                if value is None:
                    reason = "is missing, and the transmission follows from it"
                    yield Problem(key, reason, f"{key} = {made[key]} would do, or zenith_transmission in place of all")
