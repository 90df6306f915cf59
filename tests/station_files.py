"""The shipped missions with their own terminal on the ground, under a satellite that sends the light it tracks."""

from microrad.mission.file import load_mission
from shipped import SHIPPED

TURBULENCE = """[channel.turbulence]
ground_strength = 1.7e-14 # literature: profile 5/7
wind_rms = "21 m/s"       # literature: profile 5/7
fades = "gamma-gamma"     # assumption: the deeper fades
wander = "dios-2004"      # assumption: one of two
tilt = "zernike"          # assumption: the plane that fits best
corrected_modes = 0       # assumption: none
"""
ORBITS = """[orbit.leo]
kind = "station"
latitude = "28.3 deg"
longitude = "-16.5 deg"
height = "2393 m"
mask = "20 deg"

[orbit.geo]
kind = "circular"
altitude = "500 km"
inclination = "97.4 deg"
node = "0 deg"
phase = "0 deg"
gravity = "j2"

"""


def _cut(text, begin, end):
    at = text.index(begin)
    return text[:at] + text[text.index(end, at) :]


def station_text(turbulence=TURBULENCE, of=SHIPPED):
    """A shipped mission with a station as its own terminal, below a satellite; without distances and other ways."""
    text = of.read_text(encoding="utf-8")
    operations, mirror = (f"# {'-' * 97} {name}" for name in ("operations", "fast steering mirror"))
    text = _cut(text, "[orbit.leo]", operations)
    text = text.replace(operations, ORBITS + operations)
    text = _cut(text, "[operations.downlink]", "[operations.contact]")
    text = _cut(text, f"# {'-' * 97} constellation", mirror)
    text = "".join(line for line in text.splitlines(keepends=True) if not line.startswith("distance = "))
    return text.replace("[requirement]", f"[channel]\nzenith_transmission = 0.9\n\n{turbulence}\n[requirement]", 1)


def station_file(folder, *changes, turbulence=TURBULENCE, of=SHIPPED):
    """That mission with pieces of its text replaced, each of which occurs once."""
    text = station_text(turbulence, of)
    for old, new in changes:
        assert text.count(old) == 1, old
        text = text.replace(old, new)
    return load_mission(folder / "station.toml", text=text)
