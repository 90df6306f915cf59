"""The shipped link to a station with keys changed: down as it stands, up with the station as the sender, and typed."""

import tomllib
from copy import deepcopy

from link_files import with_keys, written
from microrad.mission.file import load_link
from microrad.mission.presets import preset_text

_SHIPPED = tomllib.loads(preset_text("ground-downlink"))

STATION, LEO = _SHIPPED["orbit"]["geo"], _SHIPPED["orbit"]["leo"]
UP = {
    "orbit.leo": STATION,
    "orbit.geo": LEO,
}  # the station sends the data, and a satellite of a large aperture takes it
SLOT = {"orbit.leo": {"kind": "geostationary", "longitude": "-10 deg"}}
TURBULENCE = {**_SHIPPED["channel"]["turbulence"]}
STILL = {"channel.turbulence": None}
TYPED = {
    "orbit": None,
    "operations": None,
    "channel.elevation": "20 deg",
    "channel.altitude": "500 km",
    "channel.station": "geo",
    "channel.height": "2393 m",
}
PHOTODIODE = {"into": "detector", "detector_radius": "40 um", "focal_length": "2 m"}
FIBRE = {"into": "single-mode fibre", "mode_radius": "best"}
WIND = {"ground": "5 m/s", "jet": "30 m/s", "peak": "9.4 km", "width": "4.8 km"}


def ground_data(*changes):
    """The tables of that mission with dotted keys given; None takes a key out."""
    return with_keys(deepcopy(_SHIPPED), *changes)


def ground_path(folder, *changes):
    """Path of a file with those tables."""
    return written(folder, ground_data(*changes), "ground.toml")


def ground_file(folder, *changes):
    """The mission of such a file."""
    return load_link(ground_path(folder, *changes))
