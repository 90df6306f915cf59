"""The angle at which the tracked light arrives, with its spectrum: what turbulence moves for the fine-pointing loop."""

import math
from collections.abc import Callable

import numpy as np

from microrad.core.arrays import Floats
from microrad.core.units import format_quantity
from microrad.link.budget import air
from microrad.link.budget.assembly import Shared
from microrad.link.turbulence import Downlink
from microrad.loop.disturbance.arrival import Arrival
from microrad.mission.file import MissionFile

LOWEST_HZ = 0.1
"""Frequency from which on the spectrum is taken: below, the outer scale of the air flattens it, and a loop follows."""

_BELOW_HIGHEST = 1e-3  # the lowest frequency is no more than this over the highest
_LEFT_OUT = 1e-4  # share of the variance above the highest frequency
_A_DECADE = 24  # frequencies


def arrival_of(file: MissionFile) -> Arrival | None:
    """Spectrum of the angle at which the light on the tracking sensor of `[fine_pointing]` arrives, about one axis.

    The light is the answer, and the air is near the station: where the loop's own terminal, "leo", stands on the
    ground, turbulence moves the angle by much. None where it flies, for light from the ground arrives there as a nearly
    plane wave from one direction; where the air is still; and without such a loop. The wind crosses the path as
    `channel.turbulence` says, and faster by `fine_pointing.reference.line_of_sight_rate` times the height. The spectrum
    ends where a ten thousandth of the variance lies above, or at half the rate of the plant's steps.

    Args:
        file: The mission.

    Raises:
        ValueError: For air that rests somewhere over the station, which has no spectrum, and a wind that is none.
    """
    m, f = file.mission, file.mission.fine_pointing
    if f is None or m.channel is None or m.channel.turbulence is None or not m.loop_in_turbulence:
        return None
    shared, table, diameter = Shared.of(m), m.channel.turbulence, m.terminals.leo_aperture_m
    assert shared.sky is not None  # there is a path
    slant = shared.sky.slant(m.answer.wavelength_m, shared.range_m(m.answer))
    assert slant is not None  # there is turbulence
    down = Downlink(slant)
    try:
        wind = air.wind_of(table, f.reference.line_of_sight_rate_rad_s)
    except ValueError as error:
        raise ValueError(f"channel.turbulence.wind_rms has no wind over height that holds: {error}") from None
    speed = wind.speed_m_s(slant.layers()[0])
    if not float(np.min(speed)) > 0.0:
        raise ValueError(
            "the air over the station is at rest at some height, and its angle of arrival has no spectrum then: give a "
            "wind in channel.turbulence, or how fast the line of sight turns in fine_pointing.reference"
        )

    def density(freq_hz: Floats) -> Floats:
        return down.arrival_psd_rad2_hz(freq_hz, diameter, wind, table.tilt)

    rms = down.arrival_rms_rad(diameter, table.tilt)
    scale = float(np.min(speed)) / diameter, float(np.max(speed)) / diameter
    freq = _frequencies(density, rms, scale, 0.5 / f.plant_step_s)
    elevation = f"{math.degrees(slant.elevation_rad):.4g} deg"
    light, size = format_quantity(m.answer.wavelength_m, "m"), format_quantity(diameter, "m")
    return Arrival(
        tuple(freq.tolist()),
        tuple(density(freq).tolist()),
        rms,
        f"light of {light} in {size} at {elevation} of elevation, r0 {format_quantity(slant.fried_m, 'm', 3)}, wind "
        f"{format_quantity(wind.ground_m_s, 'm/s', 3)} at the ground and {format_quantity(wind.rms_m_s, 'm/s', 3)} rms "
        f"from 5 to 20 km, tilt {table.tilt}",
        air.source_of_air(file.sources, "tilt"),
    )


def _frequencies(
    density: Callable[[Floats], Floats], rms_rad: float, scale_hz: tuple[float, float], most_hz: float
) -> Floats:
    """Frequencies (Hz) of the spectrum, evenly over their logarithm.

    Args:
        density: One-sided density (rad^2/Hz) at frequencies.
        rms_rad: Root of its integral.
        scale_hz: Speed of the slowest and of the fastest air over the aperture.
        most_hz: Highest frequency that is looked at.
    """
    low, high = 1e-3 * scale_hz[0], 1e2 * scale_hz[1]
    looked = np.geomspace(low, high, 2 + math.ceil(_A_DECADE * math.log10(high / low)))
    values = density(looked)
    above = np.cumsum((0.5 * (values[1:] + values[:-1]) * np.diff(looked))[::-1])[::-1]
    last = min(float(looked[np.argmax(above < _LEFT_OUT * rms_rad**2)]), most_hz)
    first = min(LOWEST_HZ, _BELOW_HIGHEST * last)
    return np.geomspace(first, last, 1 + math.ceil(_A_DECADE * math.log10(last / first)))
