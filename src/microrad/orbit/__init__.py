"""Orbits: where satellites and stations are, when they see one another, how the line of sight moves meanwhile."""

from microrad.orbit.base import Orbit, OrbitError
from microrad.orbit.earth.epoch import Epoch
from microrad.orbit.earth.figure import EARTH_RADIUS_M, GEOSTATIONARY_RADIUS_M, Earth, Station, elevation_rad, subpoint
from microrad.orbit.earth.sun import sun_direction
from microrad.orbit.files import read_elements
from microrad.orbit.from_mission import Pair, pair, relays, repeats, satellites, stations
from microrad.orbit.propagation.analytic import (
    GeostationarySlot,
    KeplerOrbit,
    circular,
    sun_synchronous_inclination_rad,
)
from microrad.orbit.propagation.ephemeris import EphemerisOrbit
from microrad.orbit.propagation.mean_elements import sgp4_orbit
from microrad.orbit.visibility.contacts import Contact, CoplanarContact, Pass, contacts, coplanar_contact, passes
from microrad.orbit.visibility.limits import UNLIMITED, Limits, Terminal
from microrad.orbit.visibility.line_of_sight import LineOfSight, sight

__all__ = [
    "EARTH_RADIUS_M",
    "GEOSTATIONARY_RADIUS_M",
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
    "Station",
    "Terminal",
    "circular",
    "contacts",
    "coplanar_contact",
    "elevation_rad",
    "pair",
    "passes",
    "read_elements",
    "relays",
    "repeats",
    "satellites",
    "sgp4_orbit",
    "sight",
    "stations",
    "subpoint",
    "sun_direction",
    "sun_synchronous_inclination_rad",
]
