"""What a turbulent wavefront costs at the focus: what adaptive optics leaves of it, and the light on a disk."""

import math

import numpy as np

COHERENCE = 2.1
"""Fried's parameter over the radius at which the field's coherence is 1/e."""
TILT_MODES = 3
"""Zernike modes of a wavefront's piston and tilts."""

# Noll 1976, J. Opt. Soc. Am. 66, 207, table IV: without any correction, and behind the first, second, ... mode
_NOLL = (1.0299, 1.0299, 0.582, 0.134, 0.111, 0.0880, 0.0648, 0.0587, 0.0525, 0.0463, 0.0401, 0.0377, 0.0352)
_NODES, _MOST_NODES = 200, 3000


def residual(modes: int) -> float:
    """Phase variance over (D / r0)^(5/3) that is left behind the first modes of Zernike (Noll 1976, table IV).

    Beyond those of the table it is 0.2944 modes^(-sqrt(3) / 2).

    Args:
        modes: How many are taken out, piston among them.
    """
    return _NOLL[modes] if modes < len(_NOLL) else 0.2944 * modes ** (-math.sqrt(3.0) / 2.0)


def encircled(
    radius_rad: float, diameter_m: float, wavelength_m: float, fried_m: float, *, tilt_taken_out: bool = False
) -> float:
    """Share of the light of a whole round aperture that falls on a disk in its focus, in the mean over time.

    It is 2 pi a / lambda times the integral of the aperture's transfer function times that of the air times J1(2 pi a
    rho / lambda) over rho from 0 to D. That of the air is exp(-3.44 (rho / r0)^(5/3)), and with the tilt taken out the
    exponent times 1 - (rho / D)^(1/3) (Fried 1966, J. Opt. Soc. Am. 56, 1372).

    Args:
        radius_rad: Radius a of the disk over the focal length (rad).
        diameter_m: Diameter D of the aperture (m).
        wavelength_m: Wavelength lambda (m).
        fried_m: Fried's parameter r0 (m), infinite without turbulence.
        tilt_taken_out: Whether the image is kept on the middle of the disk.
    """
    from scipy.special import j1

    turn = 2.0 * math.pi * radius_rad * diameter_m / wavelength_m
    node, weight = np.polynomial.legendre.leggauss(min(_NODES + int(turn), _MOST_NODES))
    x = (node + 1.0) / 2.0  # rho over D
    whole = 2.0 / math.pi * (np.arccos(x) - x * np.sqrt(1.0 - x**2))
    air = np.exp(
        -3.44 * (x * diameter_m / fried_m) ** (5.0 / 3.0) * (1.0 - x ** (1.0 / 3.0) if tilt_taken_out else 1.0)
    )
    return float(turn * (weight / 2.0 * whole * air) @ j1(turn * x))
