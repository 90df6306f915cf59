"""Orbits: where satellites and stations are, when they see one another, how the line of sight moves meanwhile.

`operations` makes data of contacts, and `day` says what a link delivers in a day.
"""

from microrad.core.earth import EARTH_RADIUS_M, GEOSTATIONARY_RADIUS_M
from microrad.orbit.base import OrbitError
from microrad.orbit.earth.epoch import Epoch
from microrad.orbit.earth.figure import Earth, GroundSite, Station, subpoint
from microrad.orbit.earth.sun import sun_direction
from microrad.orbit.from_mission import Pair, pair, relays, repeats, satellites, stations
from microrad.orbit.propagation.analytic import GeostationarySlot, KeplerOrbit, circular
from microrad.orbit.visibility.contacts import (
    Contact,
    CoplanarContact,
    Pass,
    contacts,
    coplanar_contact,
    passes,
    station_range,
)
from microrad.orbit.visibility.limits import UNLIMITED, Terminal
from microrad.orbit.visibility.line_of_sight import LineOfSight, sight

__all__ = [
    "EARTH_RADIUS_M",
    "GEOSTATIONARY_RADIUS_M",
    "UNLIMITED",
    "Contact",
    "CoplanarContact",
    "Earth",
    "Epoch",
    "GeostationarySlot",
    "GroundSite",
    "KeplerOrbit",
    "LineOfSight",
    "OrbitError",
    "Pair",
    "Pass",
    "Station",
    "Terminal",
    "circular",
    "contacts",
    "coplanar_contact",
    "pair",
    "passes",
    "relays",
    "repeats",
    "satellites",
    "sight",
    "station_range",
    "stations",
    "subpoint",
    "sun_direction",
]
