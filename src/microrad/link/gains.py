"""Gains and losses of a link in decibels; a function called `..._loss_db` returns a positive number."""

import math

import numpy as np
from numpy.typing import ArrayLike

from microrad.core.arrays import Floats, reals
from microrad.core.units import LEAST, PLANCK_J_S, SPEED_OF_LIGHT_M_S, format_quantity
from microrad.mission.fields import Quantity, Share

DB_PER_NEPER = 10.0 / math.log(10.0)
_SHARE = Quantity("", above=0.0, most=1.0)


def checked(name: str, values: ArrayLike, rule: Quantity, why: str = "") -> Floats:
    """Values as an array, all of them allowed.

    Args:
        name: What they are, in the words of the message.
        values: The values, in the unit of the rule, any shape.
        rule: The bounds.
        why: Why the bounds hold, for the message.

    Raises:
        ValueError: For a value that is not finite or out of bounds.
    """
    array = reals(values, name)
    if rule.unit and rule.above == 0.0 and np.any((array > 0.0) & (array < LEAST)):
        raise ValueError(f"{name} is below {LEAST:g} {rule.unit}, which nothing is: check unit and scale")
    for extreme in (np.min(array), np.max(array)) if array.size else ():  # nan is both
        rule.check(name, float(extreme), why)
    return array


def aperture_gain_db(diameter_m: float, wavelength_m: float) -> float:
    """On-axis gain of a uniformly lit circular aperture, in dB, (pi D / lambda)^2.

    Args:
        diameter_m: Diameter D of the aperture, in m.
        wavelength_m: Wavelength lambda, in m.
    """
    return 20.0 * math.log10(math.pi * diameter_m / wavelength_m)


def gaussian_beam_gain_db(half_angle_rad: float) -> float:
    """On-axis gain of an untruncated Gaussian beam, 8 / theta^2, with theta the half angle at 1/e2 of intensity."""
    return 10.0 * math.log10(8.0 / half_angle_rad**2)


def peak_radiant_intensity_w_sr(power_w: float, half_angle_rad: float) -> float:
    """Radiant intensity on the axis of a lossless Gaussian beam, 2 P / (pi theta^2): its gain times P / (4 pi).

    Args:
        power_w: Power P of the beam, in W.
        half_angle_rad: Half angle theta at 1/e2 of intensity, in rad.
    """
    return 2.0 * power_w / (math.pi * half_angle_rad**2)


def implied_transmission_db(measured_w_sr: float, power_w: float, half_angle_rad: float) -> float:
    """What lies between a measured peak radiant intensity and that of a lossless beam, in dB: negative for a loss.

    Transmission of the optics, wavefront error and truncation together.

    Args:
        measured_w_sr: Measured peak radiant intensity, in W/sr.
        power_w: Power of the beam before any loss, in W.
        half_angle_rad: Half angle at 1/e2 of intensity, in rad.

    Raises:
        ValueError: For an intensity that is not above zero, or above the lossless beam's.
    """
    ideal = peak_radiant_intensity_w_sr(power_w, half_angle_rad)
    if not 0.0 < measured_w_sr <= ideal * (1.0 + 1e-9):
        raise ValueError(
            f"a peak of {measured_w_sr:.4g} W/sr is not above 0 and at most {ideal:.4g} W/sr, which "
            f"{format_quantity(power_w, 'W')} in a half angle of {format_quantity(half_angle_rad, 'rad')} at 1/e2 "
            "reach without loss; check the convention of the divergence"
        )
    return 10.0 * math.log10(measured_w_sr / ideal)


def free_space_loss_db(distance_m: float, wavelength_m: float) -> float:
    """Loss between isotropic antennas in dB, positive, (4 pi R / lambda)^2 (Friis 1946).

    Args:
        distance_m: Distance R, in m.
        wavelength_m: Wavelength lambda, in m.
    """
    return 20.0 * math.log10(4.0 * math.pi * distance_m / wavelength_m)


def far_field_m(aperture_m: float, wavelength_m: float) -> float:
    """Distance in m beyond which an aperture's far field holds, 2 D^2 / lambda (Fraunhofer).

    Args:
        aperture_m: Diameter D of the aperture, in m.
        wavelength_m: Wavelength lambda, in m.
    """
    return 2.0 * aperture_m**2 / wavelength_m


def gaussian_pointing_loss_db(error_rad: ArrayLike, half_angle_rad: float) -> Floats:
    """Loss of a Gaussian beam off its axis, exp(-2 (error / theta)^2): 8.686 (error / theta)^2 dB.

    Args:
        error_rad: Angles from the axis, in rad, any shape.
        half_angle_rad: Half angle theta at 1/e2 of intensity, in rad.
    """
    return 2.0 * DB_PER_NEPER * (np.asarray(error_rad, dtype=np.float64) / half_angle_rad) ** 2


def pointing_loss_db(error_rad: ArrayLike, aperture_m: float, wavelength_m: float, convention: str) -> Floats:
    """Loss of a diffraction-limited beam off its axis, in dB and positive.

    "gaussian": a Gaussian beam of 1/e2 radius D/2 at the aperture, theta = 2 lambda / (pi D). "gain": exp(-G error^2)
    with G = (pi D / lambda)^2, twice as many decibels.

    Args:
        error_rad: Angles from the axis, in rad, any shape.
        aperture_m: Diameter D of the aperture that the beam leaves, in m.
        wavelength_m: Wavelength lambda, in m.
        convention: "gaussian" or "gain".

    Raises:
        ValueError: For another convention.
    """
    error = np.asarray(error_rad, dtype=np.float64)
    return pointing_db_per_rad2(aperture_m, wavelength_m, convention) * error**2


def pointing_db_per_rad2(aperture_m: float, wavelength_m: float, convention: str) -> float:
    """Pointing loss in dB over the square of the error in rad; both conventions have such a constant.

    Args:
        aperture_m: Diameter of the aperture that the beam leaves, in m.
        wavelength_m: Wavelength, in m.
        convention: "gaussian" or "gain", as `pointing_loss_db` tells them.

    Raises:
        ValueError: For another convention.
    """
    gain = (math.pi * aperture_m / wavelength_m) ** 2
    if convention == "gain":
        return DB_PER_NEPER * gain
    if convention == "gaussian":
        return DB_PER_NEPER * gain / 2.0
    raise ValueError(f'pointing-loss convention "{convention}" is neither "gaussian" nor "gain"')


def strehl_loss_db(strehl: float, convention: str) -> float:
    """Loss by wavefront error in dB, positive, from a stated Strehl.

    Args:
        strehl: The Strehl as it is stated, a loss in dB or a ratio.
        convention: "decibel" takes the Strehl as it is, "ratio" takes -10 lg of it.

    Raises:
        ValueError: For a ratio that is not above 0 and at most 1, a negative loss, and another convention.
    """
    if convention == "decibel":
        Quantity("dB", least=0.0).check("the Strehl loss", strehl)
        return strehl
    if convention == "ratio":
        _SHARE.check("the Strehl ratio", strehl, "1 is a perfect wavefront")
        return 0.0 - 10.0 * math.log10(strehl)
    raise ValueError(f'Strehl convention "{convention}" is neither "decibel" nor "ratio"')


def strehl_ratio(wavefront_error_m: float, wavelength_m: float) -> float:
    """Strehl ratio of an rms wavefront error, exp(-(2 pi sigma / lambda)^2) (Marechal, as extended by Mahajan).

    Args:
        wavefront_error_m: Rms wavefront error sigma, in m.
        wavelength_m: Wavelength lambda, in m.
    """
    return math.exp(-((2.0 * math.pi * wavefront_error_m / wavelength_m) ** 2))


def obscuration_loss_db(obscuration: float) -> float:
    """Loss (dB) by a central obscuration of an aperture: -10 lg(1 - e^2), e the ratio of the diameters.

    Raises ValueError for a ratio that is not at least 0 and below 1.
    """
    Share("", least=0.0).check("the obscuration", obscuration, "1 is the whole aperture")
    return 0.0 - 10.0 * math.log10(1.0 - obscuration**2)


def air_mass(elevation_rad: float) -> float:
    """Length of the path through the atmosphere over that to the zenith (Kasten and Young 1989, Eq. 3).

    Raises ValueError below 0 and above 90 degrees of elevation.
    """
    degrees = math.degrees(elevation_rad)
    if not 0.0 <= degrees <= 90.0 + 1e-9:
        raise ValueError(f"an elevation of {degrees:g} deg is not between 0 and 90 deg, horizon and zenith")
    return float(1.0 / (math.sin(elevation_rad) + 0.50572 * (degrees + 6.07995) ** -1.6364))


def clear_sky_loss_db(zenith_transmission: float, elevation_rad: float) -> float:
    """Loss (dB) by absorption and scattering in a clear atmosphere.

    It is the loss towards the zenith times the air mass (Beer and Lambert).

    Args:
        zenith_transmission: Share of the light that comes through towards the zenith, above 0 and at most 1.
        elevation_rad: Elevation of the path above the horizon, in rad.

    Raises:
        ValueError: For a transmission that is not above 0 and at most 1, and as `air_mass`.
    """
    _SHARE.check("the transmission", zenith_transmission, "1 is vacuum")
    return 0.0 - 10.0 * math.log10(zenith_transmission) * air_mass(elevation_rad)


def rayleigh_depth(wavelength_m: float, height_m: float) -> float:
    """Optical depth to the zenith by the scattering of molecules (Hansen and Travis 1974, Space Sci. Rev. 16, 527).

    It is 0.008569 L^-4 (1 + 0.0113 L^-2 + 0.00013 L^-4) exp(-height / 8434.5 m), L the wavelength in um.

    Args:
        wavelength_m: Wavelength, in m.
        height_m: Height of the station above the sea, in m.
    """
    square = (wavelength_m * 1e6) ** -2
    return 0.008569 * square**2 * (1.0 + 0.0113 * square + 0.00013 * square**2) * math.exp(-height_m / 8434.5)


def aerosol_depth(wavelength_m: float, depth_at_1um: float, exponent: float) -> float:
    """Optical depth to the zenith of haze: that at 1 um times the wavelength in um to minus the exponent (Angstrom).

    Args:
        wavelength_m: Wavelength, in m.
        depth_at_1um: Optical depth at 1 um.
        exponent: Angstrom's exponent.
    """
    return depth_at_1um * math.pow(wavelength_m * 1e6, -exponent)


def photon_energy_j(wavelength_m: float) -> float:
    """Energy (J) of one photon, h c / lambda."""
    return PLANCK_J_S * SPEED_OF_LIGHT_M_S / wavelength_m


def dbm(power_w: float) -> float:
    """The level in dBm of a power in W."""
    return 10.0 * math.log10(power_w) + 30.0


def watt(level_dbm: float) -> float:
    """The power in W of a level in dBm."""
    return float(10.0 ** ((level_dbm - 30.0) / 10.0))
