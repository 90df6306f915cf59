"""The angle at which light arrives out of turbulent air, as a disturbance of the loop that tracks this light."""

from dataclasses import dataclass, replace
from functools import lru_cache

from microrad.core.units import format_quantity
from microrad.loop.disturbance.fits import fit_table
from microrad.loop.disturbance.records import Disturbance

ANGLE_OF_ARRIVAL = "angle of arrival"


@dataclass(frozen=True, slots=True)
class Arrival:
    """Spectrum of the angle of arrival about one axis, `link.arrival_of`.

    ``freq_hz`` (Hz) rise, and ``psd_rad2_hz`` are the one-sided densities there (rad^2/Hz), of each axis.
    ``rms_rad`` is that of all frequencies, closed. ``basis`` says of which light and air, ``source`` where these come
    from.
    """

    freq_hz: tuple[float, ...]
    psd_rad2_hz: tuple[float, ...]
    rms_rad: float
    basis: str
    source: str


@lru_cache(maxsize=64)
def angle_of_arrival(arrival: Arrival) -> Disturbance:
    """The disturbance of one axis that has this spectrum: a shaping filter fitted to it.

    The loop follows this angle as it follows a motion of the body. A beam that the same mirror sends goes back the way
    that the light came.

    Args:
        arrival: The spectrum.

    Raises:
        ValueError: As `fit_table`.
    """
    made = fit_table(
        arrival.freq_hz,
        arrival.psd_rad2_hz,
        convention="per-axis",
        name=ANGLE_OF_ARRIVAL,
        source=arrival.source,
    ).disturbance
    low, high = (format_quantity(f, "Hz", 3) for f in (arrival.freq_hz[0], arrival.freq_hz[-1]))
    return replace(made, basis=f"{arrival.basis}; from {low} to {high}; {made.basis}")
