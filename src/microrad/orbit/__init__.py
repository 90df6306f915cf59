"""Orbits: where satellites and stations are, when they see one another, how the line of sight moves meanwhile."""

from microrad.orbit.analytic import GeostationarySlot, KeplerOrbit, circular, sun_synchronous_inclination_rad
from microrad.orbit.base import Orbit, OrbitError, States
from microrad.orbit.closed_form import CoplanarContact, coplanar_contact
from microrad.orbit.contacts import (
    EARTH,
    END,
    START,
    Contact,
    Pass,
    Sampled,
    coarse_step_s,
    coarse_times,
    contacts,
    contacts_with_each,
    passes,
)
from microrad.orbit.earth import EARTH_RADIUS_M, GEOSTATIONARY_RADIUS_M, Earth, subpoint
from microrad.orbit.element_files import read_elements
from microrad.orbit.elements import Sgp4Orbit, sgp4_orbit
from microrad.orbit.ephemeris import EphemerisOrbit
from microrad.orbit.epoch import Epoch
from microrad.orbit.events import positive
from microrad.orbit.from_mission import TAIL_S, Pair, pair, relays, repeats, satellites, stations, table
from microrad.orbit.ground import Station, elevation_rad
from microrad.orbit.limits import UNLIMITED, Limits, Terminal
from microrad.orbit.line_of_sight import LineOfSight, sight
from microrad.orbit.oem import read_oem
from microrad.orbit.sun import shadow_rad, sun_direction

__all__ = [
    "EARTH",
    "EARTH_RADIUS_M",
    "END",
    "GEOSTATIONARY_RADIUS_M",
    "START",
    "TAIL_S",
    "UNLIMITED",
    "Contact",
    "CoplanarContact",
    "Earth",
    "EphemerisOrbit",
    "Epoch",
    "GeostationarySlot",
    "KeplerOrbit",
    "Limits",
    "LineOfSight",
    "Orbit",
    "OrbitError",
    "Pair",
    "Pass",
    "Sampled",
    "Sgp4Orbit",
    "States",
    "Station",
    "Terminal",
    "circular",
    "coarse_step_s",
    "coarse_times",
    "contacts",
    "contacts_with_each",
    "coplanar_contact",
    "elevation_rad",
    "pair",
    "passes",
    "positive",
    "read_elements",
    "read_oem",
    "relays",
    "repeats",
    "satellites",
    "sgp4_orbit",
    "shadow_rad",
    "sight",
    "stations",
    "subpoint",
    "sun_direction",
    "sun_synchronous_inclination_rad",
    "table",
]
