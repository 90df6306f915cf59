"""Contacts of two orbits, or of an orbit and a ground station, without a mission file."""

from microrad.orbit.base import Orbit, OrbitError
from microrad.orbit.earth.epoch import Epoch
from microrad.orbit.earth.figure import Earth, Station
from microrad.orbit.propagation.mean_elements import ElementSet, Sgp4Orbit
from microrad.orbit.visibility.contacts import Contact, contacts, passes
from microrad.orbit.visibility.limits import UNLIMITED, Terminal


def find_contacts(
    first: ElementSet | Orbit,
    second: ElementSet | Orbit | Station,
    start: str,
    duration_s: float,
    *,
    grazing_height_m: float = 100e3,
) -> tuple[Contact, ...]:
    """When two satellites see each other past the Earth, or a station sees a satellite above its mask.

    Args:
        first: A satellite: an element set of a TLE or OMM file (`read_elements`), flown by SGP4, or an orbit
            whose epoch is `start`.
        second: Another one, or a ground station.
        start: UTC at which times count from 0, such as "2026-03-20T12:00:00Z".
        duration_s: How long is searched (s), above 0.
        grazing_height_m: Height that the line of sight between satellites has to stay above (m), over the ellipsoid.

    Raises:
        OrbitError: For an instant, elements or a span that cannot be, and an orbit of another epoch; says why.

    Example:
        ```python
        import microrad

        leo, relay = microrad.read_elements("satellites.tle")
        for contact in microrad.find_contacts(leo, relay, start=leo.epoch.text, duration_s=86_400.0):
            print(f"{contact.start_s:8.0f} s  {contact.duration_s / 60:5.1f} min  until {contact.ends}")
        ```
    """
    epoch = Epoch(start)
    if not duration_s > 0.0:
        raise OrbitError(f"a search of {duration_s} s finds nothing: give a duration above 0 s")
    span = (0.0, duration_s)
    orbit = _flown(first, epoch, duration_s)
    if isinstance(second, Station):
        return passes(orbit, second, epoch, span)
    other = _flown(second, epoch, duration_s)
    sides = Terminal(orbit, UNLIMITED, orbit.name), Terminal(other, UNLIMITED, other.name)
    return contacts(*sides, Earth("oblate", grazing_height_m), epoch, span)


def _flown(given: ElementSet | Orbit, epoch: Epoch, duration_s: float) -> Orbit:
    if isinstance(given, Station):
        raise OrbitError(f"station {given.name!r} stands first: give the satellite first, and the station second")
    if not isinstance(given, ElementSet):
        own: Epoch = getattr(given, "epoch", epoch)
        if own.seconds_to(epoch):
            raise OrbitError(
                f"orbit {given.name!r} counts its times from {own.text}, and the search from {epoch.text}: "
                "start the search there, or make the orbit with this epoch"
            )
        return given
    orbit = Sgp4Orbit(given, epoch)
    orbit.require(0.0, duration_s)
    return orbit
