"""Where disturbances come from: measured base motion in closed form, attitude control, reaction wheels."""

import math
from dataclasses import replace

import numpy as np

from microrad.core.units import format_quantity
from microrad.loop.disturbance.records import (
    Convention,
    Disturbance,
    SpectralLine,
    above_zero,
    at_least_zero,
    combine,
    share,
)
from microrad.loop.disturbance.terms import Term, term_filter

MICIUS_EDGES_HZ = (0.0, 1.0, 10.0, 50.0, 100.0)
MICIUS_RMS_RAD = (8.6e-6, 2.8e-6, 1.9e-6, 0.6e-6)
"""Body motion of the Micius satellite before tracking: rms in the bands between ``MICIUS_EDGES_HZ``."""


def from_terms(terms: list[Term], name: str, basis: str, source: str) -> Disturbance:
    """Disturbance with one white input for each term.

    Args:
        terms: Spectra of first and second order that add up to its spectrum; none for no filter.
        name: What the disturbance is called.
        basis: How the filter came about.
        source: Who gave the numbers.
    """
    empty = Disturbance(name, np.zeros((0, 0)), np.zeros((0, 0)), np.zeros((1, 0)), (), basis, source)
    parts = [term_filter(term) for term in terms]
    filters = [replace(empty, A=A, B=B, C=C) for A, B, C in parts]
    return replace(combine(empty, *filters), name=name, basis=basis, source=source)


def first_order(
    level_rad2_hz: float, corner_hz: float, *, convention: Convention, name: str = "first order", source: str = "given"
) -> Disturbance:
    """Disturbance with the one-sided density S(f) = level / (1 + (f / corner)^2).

    Its variance is pi / 2 x level x corner.

    Args:
        level_rad2_hz: Density at low frequencies, 0 or above.
        corner_hz: Frequency at which the density is half of that, above 0.
        convention: What the level is: "radial", of both axes together, or "per-axis".
        name: What the disturbance is called.
        source: Who gave the numbers.

    Raises:
        ValueError: For a negative level and for a corner that is not above zero.
    """
    at_least_zero(level_rad2_hz, f'level of "{name}"', "rad^2/Hz")
    above_zero(corner_hz, f'corner frequency of "{name}"', "Hz")
    variance = 0.5 * math.pi * level_rad2_hz * corner_hz * share(convention)
    basis = f"S(f) = {level_rad2_hz:g} / (1 + (f / {corner_hz:g} Hz)^2) rad^2/Hz, one-sided, {convention}"
    return from_terms([Term("first-order", variance, corner_hz)], name, basis, source)


def olympus(*, convention: Convention = "radial") -> Disturbance:
    """Base motion of the OLYMPUS satellite, 160 / (1 + f^2) urad^2/Hz with f in Hz: 15.85 urad rms, taken as radial.

    Where a study reads the same spectrum as that of each axis, ``convention`` says so.
    """
    return first_order(160e-12, 1.0, convention=convention, name="OLYMPUS", source="ESA OLYMPUS base motion spectrum")


def body_pointing(
    error_rad: float, sigmas: float, bandwidth_hz: float, *, convention: Convention = "per-axis"
) -> Disturbance:
    """Slow error of the coarse stage: a maximally flat low pass of second order with its half power at the bandwidth.

    Args:
        error_rad: Error at a number of standard deviations: 300 urad at 3 sigma is 100 urad rms.
        sigmas: That number of standard deviations.
        bandwidth_hz: Bandwidth of the attitude control, at which the density has fallen to half.
        convention: What the error is: "radial", of both axes together, or "per-axis".

    Raises:
        ValueError: For a negative error and for sigmas or a bandwidth that are not above zero.
    """
    at_least_zero(error_rad, "body pointing error", "rad")
    above_zero(sigmas, "number of sigmas of the body pointing error", "standard deviations")
    above_zero(bandwidth_hz, "bandwidth of the body pointing error", "Hz")
    variance = (error_rad / sigmas) ** 2 * share(convention)
    given = f"{format_quantity(error_rad, 'rad')} at {sigmas:g} sigma, {convention}"
    term = Term("low-pass", variance, bandwidth_hz, math.sqrt(0.5))
    basis = f"{given}; second-order low pass of damping 0.707 at {bandwidth_hz:g} Hz"
    return from_terms([term], "body pointing", basis, "attitude control")


def wheels(
    speed_hz: float,
    harmonics: tuple[float, ...],
    coefficients_rad_hz2: tuple[float, ...],
    *,
    convention: Convention,
    source: str = "given",
) -> Disturbance:
    """Lines of a reaction wheel: of amplitude C_i speed^2 at the frequency h_i x speed.

    The force of harmonic h_i grows with the square of the speed; C_i holds the wheel's imbalance and the structure's
    compliance, which is taken as constant over the speeds of interest. Radial numbers are divided by sqrt(2), equal
    power in both axes.

    Args:
        speed_hz: Turns of the wheel a second.
        harmonics: Frequency h_i of each line over the wheel's speed.
        coefficients_rad_hz2: Coefficient C_i of each line, in rad of line of sight per Hz^2.
        convention: What the coefficients are: "radial", of both axes together, or "per-axis".
        source: Who gave the numbers.

    Raises:
        ValueError: For lists that are empty or of unequal length, a speed or harmonic not above zero and a negative
            coefficient.
    """
    above_zero(speed_hz, "speed of the wheel", "Hz")
    if len(harmonics) != len(coefficients_rad_hz2) or not harmonics:
        raise ValueError(
            f"wheel: {len(harmonics)} harmonics and {len(coefficients_rad_hz2)} coefficients; give one of each per line"
        )
    size = speed_hz**2 * math.sqrt(share(convention))
    lines = []
    for harmonic, coefficient in zip(harmonics, coefficients_rad_hz2, strict=True):
        above_zero(harmonic, "harmonic of the wheel", "times the speed")
        at_least_zero(coefficient, f"coefficient of the wheel's harmonic {harmonic:g}", "rad/Hz^2")
        lines.append(SpectralLine(coefficient * size, harmonic * speed_hz))
    basis = f"amplitudes C_i speed^2 of {len(lines)} harmonics at {speed_hz:g} turns a second, {convention}"
    return replace(from_terms([], "reaction wheel", basis, source), lines=tuple(lines))
