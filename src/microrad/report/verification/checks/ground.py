"""Checks of links to a station: lengths and variances by adaptive integrals, fades by draws, published figures."""

import math
import re
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
from scipy.integrate import quad

from microrad.report.registry import flattened
from microrad.report.verification.check import Check
from microrad.report.verification.evidence import Comparison, Referent
from microrad.report.verification.workspace import Workspace

_EARTH_M, _WAVELENGTH_M, _HEIGHT_M, _ALTITUDE_M, _APERTURE_M = 6378137.0, 1.55e-6, 0.0, 500e3, 0.4
_ZENITH, _OUTAGE, _DRAWS = 0.9, 0.01, 4_000_000
_PATH = f"""
[channel]
zenith_transmission = {_ZENITH}
elevation = "30 deg"
altitude = "500 km"
station = "geo"
height = "0 m"

[channel.turbulence]
ground_strength = 1.7e-14
wind_rms = "21 m/s"
fades = "log-normal"
wander = "dios-2004"
tilt = "zernike"
corrected_modes = 0
"""


def _numbers(workspace: Workspace) -> dict[str, Any]:
    """What `microrad budget` prints of the preset of a station at 30 degrees, without its orbits."""
    from microrad.link.study import run_link_study
    from microrad.mission.file import load_link
    from microrad.mission.presets import preset_text
    from microrad.report.links.data import links_data

    text = preset_text("ground-downlink")
    for table in ("channel", "jitter", "orbit", "operations", "answer", "pointing", "point_ahead"):
        text = re.sub(rf"^\[{table}(\.[^\]]*)?\]\n(?:(?!\[).*\n)*", "", text, flags=re.MULTILINE)
    path = workspace.folder / "ground.toml"
    path.write_text(text + _PATH, encoding="utf-8")
    return dict(flattened(links_data(run_link_study(load_link(path)))))


def _strength(height_m: float) -> float:
    """The profile 5/7."""
    jet = 0.00594 * (21.0 / 27.0) ** 2 * (1e-5 * height_m) ** 10 * math.exp(-height_m / 1000.0)
    return jet + 2.7e-16 * math.exp(-height_m / 1500.0) + 1.7e-14 * math.exp(-height_m / 100.0)


def _along(elevation_rad: float, weight: Callable[[float], float]) -> float:
    """Integral of the profile along a slant path, with a weight of the distance."""
    longer, total = 1.0 / math.sin(elevation_rad), 0.0
    for low, high in ((0.0, 300.0), (300.0, 3e3), (3e3, 2e4), (2e4, 6e4)):
        total += quad(lambda h: _strength(h) * weight(h * longer) * longer, low, high, epsrel=1e-9, limit=200)[0]
    return total


def _range_m(elevation_rad: float) -> float:
    """By the law of sines in the triangle of station, satellite and the Earth's centre."""
    radius = _EARTH_M + _ALTITUDE_M
    at_satellite = math.asin(_EARTH_M * math.cos(elevation_rad) / radius)
    return radius * math.cos(elevation_rad + at_satellite) / math.cos(elevation_rad)


def _path(workspace: Workspace) -> Iterator[Comparison]:
    numbers, k = _numbers(workspace), 2.0 * math.pi / _WAVELENGTH_M
    why = "1e-6 of it: nodes fixed beforehand against an adaptive integral"
    for place, degrees in enumerate((30.0, 45.0, 60.0, 90.0)):
        elevation, name = math.radians(degrees), f"ground.elevations.{place}"
        at = f"at {degrees:g} deg"
        filtered = k**2 * _along(elevation, lambda z: _aperture(z, k))
        expected = {
            "range_m": (_range_m(elevation) if degrees < 90.0 else _ALTITUDE_M, "m"),
            "fried_m": ((0.423 * k**2 * _along(elevation, lambda z: 1.0)) ** -0.6, "m"),
            "isoplanatic_rad": ((2.914 * k**2 * _along(elevation, lambda z: z ** (5 / 3))) ** -0.6, "rad"),
            "rytov": (2.25 * k ** (7 / 6) * _along(elevation, lambda z: z ** (5 / 6)), ""),
            "index": (_for_any_strength(filtered), ""),
            "air_db": (-10.0 * math.log10(_ZENITH) * _mass(degrees), "dB"),
        }
        for key, (value, unit) in expected.items():
            yield Comparison(
                f"budget.{name}.{key}", f"{key} {at}", value, numbers[f"{name}.{key}"], 1e-6 * value, unit, why
            )
    yield from _fades(numbers, k)


def _aperture(distance_m: float, k: float) -> float:
    """Variance by a layer of strength 1 over k^2, behind a Gaussian aperture of the same filter as the round one."""
    damping = _APERTURE_M**2 / 16.0
    both = complex(damping, distance_m / k) ** (5.0 / 6.0)
    return float(4.0 * math.pi**2 * 0.033 * 1.2 * math.gamma(1.0 / 6.0) * (both.real - damping ** (5.0 / 6.0)))


def _for_any_strength(variance: float) -> float:
    root = math.pow(variance, 1.2)
    large = 0.49 * variance / math.pow(1.0 + 1.11 * root, 7.0 / 6.0)
    return math.exp(large + 0.51 * variance / math.pow(1.0 + 0.69 * root, 5.0 / 6.0)) - 1.0


def _mass(degrees: float) -> float:
    return 1.0 / (math.sin(math.radians(degrees)) + 0.50572 * math.pow(degrees + 6.07995, -1.6364))


def _fades(numbers: dict[str, Any], k: float) -> Iterator[Comparison]:
    """The fade for the outage, by drawn powers; angle of arrival and Greenwood's frequency by their formulas."""
    index = _for_any_strength(k**2 * _along(math.radians(30.0), lambda z: _aperture(z, k)))
    spread = math.sqrt(math.log1p(index))
    drawn = np.random.Generator(np.random.Philox(7)).standard_normal(_DRAWS)
    fade = -float(np.quantile(10.0 * np.log10(np.exp(spread * drawn - spread**2 / 2.0)), _OUTAGE))
    why = "five standard deviations of the quantile of the drawn powers"
    at = math.exp(-0.5 * 2.3263**2) / math.sqrt(2.0 * math.pi)
    close = 5.0 * 4.343 * spread * math.sqrt(_OUTAGE / _DRAWS) / at
    for name in ("budgets.Communication.lines.Turbulence fade.value", "ground.elevations.0.fade_db"):
        sign = -1.0 if name.endswith("value") else 1.0
        yield Comparison(f"budget.{name}", "fade for 1 % of the time", sign * fade, numbers[name], close, "dB", why)
    r0 = (0.423 * k**2 * _along(math.radians(30.0), lambda z: 1.0)) ** -0.6
    arrival = math.sqrt(0.1817) * _WAVELENGTH_M / _APERTURE_M * (_APERTURE_M / r0) ** (5.0 / 6.0)
    name = "ground.beams.Communication.lines.Angle of arrival.value"
    why = "0.1 %: the printed constant has three digits (Noll 1976: 0.182)"
    yield Comparison(f"budget.{name}", "tilt about one axis", arrival, numbers[name], 1e-3 * arrival, "rad", why)


def _profile(workspace: Workspace) -> Iterator[Comparison]:
    from microrad.link.turbulence import HufnagelValley, SlantPath

    path = SlantPath(HufnagelValley(), 0.5e-6, math.pi / 2.0, 500e3)
    half = "half a unit in the last printed digit"
    name = "budget.ground.elevations.*"
    yield Comparison(f"{name}.fried_m", "r0 of the profile 5/7 at 0.5 um", 0.049606, path.fried_m, 5e-7, "m", half)
    angle = path.isoplanatic_rad
    yield Comparison(f"{name}.isoplanatic_rad", "isoplanatic angle of it", 6.894e-6, angle, 5e-10, "rad", half)


CHECKS = (
    Check(
        "ground-link",
        "A link to a station: range, air, turbulence and fades at 30 to 90 degrees",
        Referent.INDEPENDENT,
        "The triangle with the Earth's centre; adaptive integrals over the profile; drawn powers.",
        "Andrews and Phillips, Laser Beam Propagation through Random Media (2005), chapter 12",
        _path,
    ),
    Check(
        "hufnagel-valley",
        "Lengths of the profile 5/7",
        Referent.PUBLISHED,
        "Printed digits.",
        "Hufnagel-Valley 5/7 at 0.5 um: 5 cm and 7 urad, with more digits as integrated to infinity",
        _profile,
    ),
)
