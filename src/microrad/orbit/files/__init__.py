"""Orbits out of files: mean elements (TLE, OMM) and ephemerides (OEM)."""

from microrad.orbit.files.elements import read_elements
from microrad.orbit.files.oem import read_oem

__all__ = ["read_elements", "read_oem"]
