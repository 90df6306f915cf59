"""Mirrors of several axes: the record, its response and its uncertainty, tilts, mirror files of version 2."""

from microrad.mirror.coupled.geometry import tilts_and_piston
from microrad.mirror.coupled.reading import of
from microrad.mirror.coupled.records import Actuator, CoupledMirror, Known, Output, modes, response
from microrad.mirror.coupled.spread import accepted, directions, drawn, draws, is_one, moved
from microrad.mirror.coupled.writing import text

__all__ = [
    "Actuator",
    "CoupledMirror",
    "Known",
    "Output",
    "accepted",
    "directions",
    "drawn",
    "draws",
    "is_one",
    "modes",
    "moved",
    "of",
    "response",
    "text",
    "tilts_and_piston",
]
