"""What the air between a station and a satellite does to one beam: absorption, spread, wavefront, fades."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from microrad.link import coupling, gains
from microrad.link.turbulence import (
    BuftonWind,
    Downlink,
    Fades,
    GammaGamma,
    HufnagelValley,
    LogNormal,
    SlantPath,
    Uplink,
    Wandering,
    seeing,
)
from microrad.mission.ground import GroundPath
from microrad.mission.model import Source, source_text
from microrad.mission.tables.channel import Channel, TurbulenceTable

UPLINK, DOWNLINK = "uplink", "downlink"
_LEAST_SHARE, _FADES = 1e-15, 1600  # of a fade that is told from none, and how many losses stand for all
_NO_INDEX = 1e-12


@dataclass(frozen=True, slots=True)
class Sky:
    """The air on the path of a mission's links. ``point_ahead_rad`` is by how far the uplink leads the downlink."""

    channel: Channel
    path: GroundPath
    point_ahead_rad: float

    def clear_db(self, wavelength_m: float) -> float:
        """Loss (dB) by absorption and scattering in a clear sky at a wavelength (m)."""
        channel, elevation = self.channel, self.path.elevation_rad
        if channel.zenith_transmission is not None:
            return gains.clear_sky_loss_db(channel.zenith_transmission, elevation)
        depth = gains.rayleigh_depth(wavelength_m, self.path.height_m)
        depth += gains.aerosol_depth(wavelength_m, channel.aerosol_depth or 0.0, channel.angstrom_exponent or 0.0)
        to_zenith: float = gains.DB_PER_NEPER * depth + (channel.absorption_db or 0.0)
        return to_zenith * gains.air_mass(elevation)

    def slant(self, wavelength_m: float, range_m: float) -> SlantPath | None:
        """The turbulence on the path of a beam of this wavelength over this range (both m); None in still air."""
        table = self.channel.turbulence
        if table is None:
            return None
        wind = table.wind_rms_m_s
        profile = HufnagelValley(
            table.ground_strength, wind_of(table).rms_m_s if wind is None else wind, self.path.height_m
        )
        return SlantPath(profile, wavelength_m, self.path.elevation_rad, range_m)


def source_of_air(sources: Mapping[str, Source], *more: str) -> str:
    """Where the turbulence and the wind of a mission come from, as one text.

    Args:
        sources: Where each value of the mission comes from, by its dotted key.
        *more: Other keys of its table on turbulence.
    """
    wind = (f"wind.{key}" for key in ("ground", "jet", "peak", "width"))
    keys = (f"channel.turbulence.{key}" for key in ("ground_strength", "wind_rms", *wind, *more))
    return source_text(sources, *(key for key in keys if key in sources))


def wind_of(table: TurbulenceTable, slew_rad_s: float = 0.0) -> BuftonWind:
    """The wind over height: that of the table, or Bufton's with the jet scaled to the table's root mean square.

    Args:
        table: The mission's table on turbulence.
        slew_rad_s: How fast the line of sight turns (rad/s).
    """
    if table.wind is not None:
        w = table.wind
        return BuftonWind(w.ground_m_s, w.jet_m_s, w.peak_m, w.width_m, slew_rad_s)
    assert table.wind_rms_m_s is not None  # the table's own check
    usual = BuftonWind()
    scale = table.wind_rms_m_s / usual.rms_m_s
    return BuftonWind(scale * usual.ground_m_s, scale * usual.jet_m_s, usual.peak_m, usual.width_m, slew_rad_s)


@dataclass(frozen=True, slots=True)
class Receives:
    """What takes the light of a downlink at the station: its aperture, and the fibre or detector in its focus."""

    diameter_m: float
    end: coupling.End | None


@dataclass(frozen=True, slots=True)
class Turbulent:
    """What turbulence does to one beam, ``direction`` "uplink" or "downlink".

    ``spread_db`` is the loss of the mean power by a wider beam, and ``wavefront_db`` that by a wavefront which the
    fibre or detector takes less of. ``fades`` are those of the power over its mean, with the scintillation ``index``.
    ``wander_rad`` is the radial rms of an uplink's wander, ``arrival_rad`` the angle of arrival of a downlink about one
    axis, rms. ``doubts`` say beyond what the closed forms are used.
    """

    direction: str
    path: SlantPath
    index: float
    fades: Fades
    spread_db: float = 0.0
    wavefront_db: float = 0.0
    wander_rad: float = 0.0
    arrival_rad: float = 0.0
    doubts: tuple[str, ...] = ()


@lru_cache(maxsize=1024)
def downlink(table: TurbulenceTable, path: SlantPath, receives: Receives) -> Turbulent:
    """Turbulence on a beam from the satellite.

    Args:
        table: The mission's table on turbulence.
        path: The path.
        receives: What takes the light.
    """
    down = Downlink(path)
    index = max(down.index(receives.diameter_m), _NO_INDEX)
    doubts = list(path.regimes)
    wavefront, doubt = _wavefront_db(table, path, receives)
    doubts += [doubt] if doubt else []
    arrival = down.arrival_rms_rad(receives.diameter_m, table.tilt)
    return Turbulent(
        DOWNLINK,
        path,
        index,
        _law(table, index),
        wavefront_db=wavefront,
        arrival_rad=arrival,
        doubts=tuple(doubts),
    )


@lru_cache(maxsize=1024)
def uplink(table: TurbulenceTable, path: SlantPath, half_angle_rad: float, point_ahead_rad: float) -> Turbulent:
    """Turbulence on a beam from the station, taken as the Gaussian one with its far field.

    What adaptive optics leaves of the wavefront spreads the beam less, and makes it wander by no more than if all of
    that were tilt: of a radial rms angle s, tilt has the phase variance (pi D s / (2 lambda))^2 (Noll 1976).

    Args:
        table: The mission's table on turbulence.
        path: The path.
        half_angle_rad: Half angle of the beam at 1/e2 of intensity without turbulence (rad).
        point_ahead_rad: By how far the beam leads the light that the station's adaptive optics measures (rad).
    """
    up = Uplink(path, path.wavelength_m / (math.pi * half_angle_rad))
    index, doubts = max(up.index(), _NO_INDEX), list(path.regimes)
    spread, wander = up.spread_db, up.wander_rms_rad(table.wander)
    if table.corrected_modes:
        diameter = math.sqrt(8.0) * up.waist_m
        variance = _residual_rad2(table.corrected_modes, diameter / path.fried_m)
        ahead = up.anisoplanatic_rad2(point_ahead_rad)
        spread = min(spread, gains.DB_PER_NEPER * (variance + ahead))
        wander = min(wander, math.sqrt(variance + ahead) * 2.0 * path.wavelength_m / (math.pi * diameter))
        if ahead > 1.0:
            doubts.append(
                f"the point-ahead angle is {point_ahead_rad / path.isoplanatic_rad:.2g} isoplanatic angles: adaptive "
                "optics measures other air than the beam goes through"
            )
    widened = half_angle_rad * 10.0 ** (spread / 20.0)
    fades = _law(table, index)
    if wander > 0.0:
        fades = Wandering(fades, widened**2 / (2.0 * wander**2))
    return Turbulent(UPLINK, path, index, fades, spread_db=spread, wander_rad=wander, doubts=tuple(doubts))


def _law(table: TurbulenceTable, index: float) -> Fades:
    return LogNormal(index) if table.fades == "log-normal" else GammaGamma.of_index(index)


def _wavefront_db(table: TurbulenceTable, path: SlantPath, receives: Receives) -> tuple[float, str]:
    """Loss of the mean power into the fibre or detector, and what to doubt of it.

    Adaptive optics leaves Marechal's loss, or that without it (of a disk, that with the tilt alone taken out), if that
    is less.
    """
    if receives.end is None:
        return 0.0, ""
    modes, over = table.corrected_modes, receives.diameter_m / path.fried_m
    is_fibre = isinstance(receives.end, coupling.SingleModeFibre)
    seen = _fibre_db(receives.end, over) if is_fibre else _disk_db(path, receives, bool(modes))
    if modes <= (0 if is_fibre else seeing.TILT_MODES):
        return seen, ""
    variance = _residual_rad2(modes, over)
    doubt = "" if variance <= 1.0 else f"a residual of {math.sqrt(variance):.2g} rad rms, above 1: Marechal's ends"
    return min(gains.DB_PER_NEPER * variance, seen), doubt


def _fibre_db(fibre: coupling.End, over: float) -> float:
    truncation, areas = fibre.pupil.truncation, (seeing.COHERENCE * over / 2.0) ** 2
    share = coupling.turbulent_share(truncation, areas) / coupling.turbulent_share(truncation, 0.0)
    return -10.0 * math.log10(share)


def _disk_db(path: SlantPath, receives: Receives, tilt_taken_out: bool) -> float:
    assert isinstance(receives.end, coupling.Disk)  # there is no other end
    disk = receives.end.radius_rad, receives.diameter_m, path.wavelength_m
    share = seeing.encircled(*disk, path.fried_m, tilt_taken_out=tilt_taken_out)
    return max(10.0 * math.log10(seeing.encircled(*disk, math.inf) / share), 0.0)


def _residual_rad2(modes: int, over: float) -> float:
    """Phase variance (rad^2) that is left over an aperture of so many r0 (Noll 1976, table IV)."""
    return seeing.residual(modes) * math.pow(over, 5.0 / 3.0)


@lru_cache(maxsize=256)
def losses(fades: Fades) -> coupling.Losses:
    """Fades as losses against the mean power, with their shares of the time.

    Args:
        fades: The fades.
    """
    deepest, highest = fades.loss_db(_LEAST_SHARE), fades.loss_db(1.0 - 1e-12)
    ends = math.floor(highest * 10.0) / 10.0, math.ceil(deepest * 10.0) / 10.0  # the same however a processor rounds
    edge = np.linspace(*ends, _FADES + 1)
    share = -np.diff(fades.below(10.0 ** (-edge / 10.0)))
    there = share > 0.0
    return coupling.Losses.of(((edge[1:] + edge[:-1]) / 2.0)[there], share[there])
