"""Light beside the signal: what a filter and a field of view let through of a sky."""

import math

from microrad.core import capacity
from microrad.core.units import PLANCK_J_S, SPEED_OF_LIGHT_M_S
from microrad.link.receivers.base import require, require_zero_or_more


def background_power_w(
    spectral_radiance_w_m2_sr_m: float, aperture_area_m2: float, field_of_view_rad: float, filter_bandwidth_m: float
) -> float:
    """Power in W that a uniform sky sends through aperture, field stop and filter, both polarisations, before any loss.

    It is L A pi sin^2(field/2) d. 1 W/(m^2 sr um) is 1e6 W/(m^2 sr m).

    Args:
        spectral_radiance_w_m2_sr_m: Radiance L of the sky per metre of wavelength, in W/(m^2 sr m).
        aperture_area_m2: Area A of the aperture, in m^2.
        field_of_view_rad: Full angle of the round field of view, in rad, filled by the sky.
        filter_bandwidth_m: Full width d of the filter in wavelength, in m.

    Raises:
        ValueError: For a negative value and a field of more than pi rad.
    """
    require_zero_or_more("the spectral radiance", spectral_radiance_w_m2_sr_m, "W/(m^2 sr m)")
    require_zero_or_more("the aperture's area", aperture_area_m2, "m^2")
    require_zero_or_more("the filter's bandwidth", filter_bandwidth_m, "m")
    require(
        0.0 <= field_of_view_rad <= math.pi,
        "the field of view",
        field_of_view_rad,
        "rad",
        "it is the full angle, from 0 rad to pi rad (a half space)",
    )
    projected_solid_angle_sr = math.pi * math.sin(field_of_view_rad / 2.0) ** 2
    return spectral_radiance_w_m2_sr_m * aperture_area_m2 * projected_solid_angle_sr * filter_bandwidth_m


def background_photons_per_mode(spectral_radiance_w_m2_sr_m: float, wavelength_m: float) -> float:
    """Mean photons in one spatial mode and one polarisation, L lambda^5 / (2 h c^2), of an unpolarised sky.

    What a single-mode receiver takes from a source that fills its mode, before any loss: about 1e-6 from a bright sky
    at 1.55 um, 0.25 from the sun.

    Args:
        spectral_radiance_w_m2_sr_m: Radiance L of the sky per metre of wavelength, in W/(m^2 sr m).
        wavelength_m: Wavelength lambda, in m.

    Raises:
        ValueError: For a negative radiance or a wavelength not above 0 m.
    """
    require_zero_or_more("the spectral radiance", spectral_radiance_w_m2_sr_m, "W/(m^2 sr m)")
    require(wavelength_m > 0.0, "the wavelength", wavelength_m, "m", "it must be above 0 m")
    return spectral_radiance_w_m2_sr_m * wavelength_m**5 / (2.0 * PLANCK_J_S * SPEED_OF_LIGHT_M_S**2)


def apd_excess_noise_factor(gain: float, ionisation_ratio: float) -> float:
    """Excess noise factor k M + (1 - k) (2 - 1/M) of an avalanche photodiode (McIntyre 1966, IEEE T-ED 13, 164).

    It holds for thick multiplication layers; thin ones have less noise.

    Args:
        gain: Mean gain M, at least 1.
        ionisation_ratio: Ratio k of holes to electrons where electrons start the avalanche (its inverse where holes
            do), from 0 to 1.

    Raises:
        ValueError: For a gain below 1, and a ratio outside 0 to 1.
    """
    require(1.0 <= gain < math.inf, "the gain of the avalanche photodiode", gain, "", "it must be at least 1")
    require(
        0.0 <= ionisation_ratio <= 1.0,
        "the ionisation ratio",
        ionisation_ratio,
        "",
        "it lies from 0 to 1; take the inverse when the other carrier starts the avalanche",
    )
    return capacity.excess_noise_factor(gain, ionisation_ratio)
