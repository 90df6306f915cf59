"""Clear-air turbulence between the ground and a satellite, in closed form: what it does to a wave, and its fades."""

from microrad.link.turbulence.fades import Fades, GammaGamma, LogNormal, Wandering
from microrad.link.turbulence.path import Downlink, SlantPath, Uplink
from microrad.link.turbulence.profile import BuftonWind, HufnagelValley

__all__ = [
    "BuftonWind",
    "Downlink",
    "Fades",
    "GammaGamma",
    "HufnagelValley",
    "LogNormal",
    "SlantPath",
    "Uplink",
    "Wandering",
]
