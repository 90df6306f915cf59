"""What a stated pointing error means by its class: mean and standard deviation about each of two axes."""

import math
from dataclasses import dataclass, replace
from typing import Literal, get_args

from microrad.link.radial_error import RADIUS, two_axes
from microrad.mission.fields import Quantity
from microrad.mission.tables.pointing import ErrorClass, Statistic

Axes = Literal["per-axis", "radial", "x"]
"""per-axis: the same about x and y; radial: off the line of sight; x: about one axis, nothing about the other."""
Interpretation = Literal["temporal", "mixed"]
"""What the confidence is a share of, see `error_term`."""

WORST_SATELLITE_SIGMAS = 3.0
"""The worst-case satellite lies this far out in the ensemble: ECSS-E-ST-60-10C leaves out members beyond 3 sigma."""

SIGMAS = {"1-sigma": 1.0, "2-sigma": 2.0, "3-sigma": 3.0}
_CHOICES = (
    ("kind", get_args(ErrorClass)),
    ("statistic", get_args(Statistic)),
    ("axes", get_args(Axes)),
)


@dataclass(frozen=True, slots=True)
class StatedError:
    """One pointing error as a data sheet or an analysis states it.

    `error_rad` is a half width about the line of sight. `statistic` says how many standard deviations it is, "bound"
    that it is never exceeded. With `axes` "radial" the k-sigma value is k times the radial rms, sqrt(2) of one axis.
    Raises ValueError for a negative error or one that is not finite, and for an unknown class, statistic or axes.
    """

    name: str
    error_rad: float
    kind: ErrorClass
    statistic: Statistic
    axes: Axes

    def __post_init__(self) -> None:
        """Raises ValueError if the error is negative or not finite, or a word is unknown."""
        RADIUS.check(f"{self.name}: the error", self.error_rad, "it is a half width")
        for key, choices in _CHOICES:
            if getattr(self, key) not in choices:
                raise ValueError(f'{self.name}: no {key} "{getattr(self, key)}"; give one of {", ".join(choices)}')

    def with_error(self, error_rad: float) -> "StatedError":
        """The same error with another half width."""
        return replace(self, error_rad=error_rad)


@dataclass(frozen=True, slots=True)
class ErrorTerm:
    """A pointing error as the summation takes it: mean and standard deviation about axis x and axis y.

    `stated_rad` is the half width that it was stated with. `gaussian` is false for a spread of another shape. No term
    is correlated with another. Raises ValueError for values that are not finite and for a negative deviation.
    """

    name: str
    kind: ErrorClass
    stated_rad: float
    mean_rad: tuple[float, float]
    sigma_rad: tuple[float, float]
    gaussian: bool = True

    def __post_init__(self) -> None:
        """Raises ValueError if a value is not finite or a standard deviation negative."""
        two_axes(f"{self.name}: the mean", self.mean_rad, Quantity("rad"))
        two_axes(f"{self.name}: the standard deviation", self.sigma_rad, RADIUS)


def error_term(stated: StatedError, interpretation: Interpretation = "temporal") -> ErrorTerm:
    """Mean and standard deviation that a stated error stands for, about each of two axes.

    The error is stated as E of k sigma, or as a bound E. "temporal" (ECSS-E-ST-60-10C A.1.2, modified): the confidence
    is a share of the time of the worst-case satellite, whose constant errors are W = 3 E / k, or the bound. "mixed": a
    share of the times of all satellites, over which constant errors spread about zero by s = E / k, a bound uniformly
    (s = E / sqrt(3); radial: over a disc, E / 2).

    | class     | temporal                     | mixed            | from                                           |
    |-----------|------------------------------|------------------|------------------------------------------------|
    | random    | 0, s                         | 0, s             | Tables B-3, B-7; a bound is uniform            |
    | bias      | W, 0                         | 0, s             | Tables B-2, B-7                                |
    | drift     | W / 2, W / sqrt(12)          | 0, s / sqrt(3)   | ours: a ramp from zero, a time evenly along it |
    | transient | W, 0                         | 0, s             | ours: counted as present all the time          |

    Drift and transient are our own formulas, because the standard has no such classes. How long a transient lasts is
    not stated: counted as always there it leaves the coverage at its least, whatever its course between 0 and W, as
    long as the other errors are symmetric about their means with a single peak (Anderson's theorem). A radial mean
    lies on the diagonal, W / sqrt(2) about each axis, where the means of the other lines add up to the most.

    Args:
        stated: The error as it is stated, with class, statistic and axes.
        interpretation: "temporal" or "mixed": over what the confidence is a share.

    Raises:
        ValueError: For another interpretation.
    """
    if interpretation not in get_args(Interpretation):
        raise ValueError(f'no interpretation "{interpretation}"; give one of {", ".join(get_args(Interpretation))}')
    worst, spread = _worst(stated), _spread(stated)
    mean, sigma = 0.0, spread
    if stated.kind == "drift":
        mean, sigma = (
            (worst / 2.0, worst / math.sqrt(12.0)) if interpretation == "temporal" else (0.0, spread / math.sqrt(3.0))
        )
    elif stated.kind in ("bias", "transient") and interpretation == "temporal":
        mean, sigma = worst, 0.0
    other = 0.0 if stated.axes == "x" else 1.0
    return ErrorTerm(
        name=stated.name,
        kind=stated.kind,
        stated_rad=stated.error_rad,
        mean_rad=(mean, other * mean),
        sigma_rad=(sigma, other * sigma),
        gaussian=sigma == 0.0 or not (stated.kind == "drift" or stated.statistic == "bound"),
    )


def basis(stated: StatedError, interpretation: Interpretation = "temporal") -> str:
    """Class, statistic and axes of a stated error, and in words the mean and the standard deviation taken for it.

    Args:
        stated: The error as it is stated.
        interpretation: "temporal" or "mixed", as of `error_term`.
    """
    where = {"per-axis": "about each axis", "radial": "radial", "x": "about one axis"}[stated.axes]
    head = f"{stated.kind}, {stated.statistic}, {where}"
    spread, worst = _spread_text(stated), _worst_text(stated)
    if interpretation == "mixed":
        size, comma, evenly = spread.partition(",")
        factor = " / sqrt(3)" if stated.kind == "drift" else ""
        ramp = {"drift": ", ramp from zero", "transient": ", counted as always present"}.get(stated.kind, "")
        spread = f"{size}{factor}{comma}{evenly}{ramp}"
        return f"{head}: mean 0, standard deviation {spread}; random satellite at a random time (mixed)"
    if stated.kind == "random":
        return f"{head}: mean 0, standard deviation {spread} over time"
    formula = {
        "bias": f"mean {worst}, constant",
        "drift": f"ramp from zero to {worst}, mean 1/2 and standard deviation 1/sqrt(12) of it",
        "transient": f"mean {worst}, counted as always present",
    }[stated.kind]
    return f"{head}: {formula}; worst-case satellite (temporal)"


def _worst(stated: StatedError) -> float:
    sigmas = SIGMAS.get(stated.statistic, WORST_SATELLITE_SIGMAS)  # the worst-case satellite is at its bound
    along = stated.error_rad * WORST_SATELLITE_SIGMAS / sigmas
    return along / math.sqrt(2.0) if stated.axes == "radial" else along


def _spread(stated: StatedError) -> float:
    radial = stated.axes == "radial"
    if stated.statistic == "bound":
        return stated.error_rad / (2.0 if radial else math.sqrt(3.0))
    return stated.error_rad / SIGMAS[stated.statistic] / (math.sqrt(2.0) if radial else 1.0)


def _worst_text(stated: StatedError) -> str:
    factor = WORST_SATELLITE_SIGMAS / SIGMAS.get(stated.statistic, WORST_SATELLITE_SIGMAS)
    along = "error" if factor == 1.0 else f"{factor:g} error"
    return f"{along} / sqrt(2) about each axis" if stated.axes == "radial" else along


def _spread_text(stated: StatedError) -> str:
    radial = stated.axes == "radial"
    if stated.statistic == "bound":
        return "error / 2, evenly over a disc" if radial else "error / sqrt(3), evenly up to the bound"
    sigmas = f"{SIGMAS[stated.statistic]:g}"
    return f"error / ({sigmas} sqrt(2))" if radial else f"error / {sigmas}"
