"""From the mirror's outputs to the line of sight: reflection, telescope, rotation, tripods; and the stroke this needs.

The mirror's normal leans towards x by one tilt and towards y by the other (rad). The x tilt turns about the axis across
the plane of incidence and moves the beam within that plane; the y tilt turns about the axis that lies in both the
plane of incidence and the mirror's surface. Reflection: k' = k - 2 (k n) n.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Annotated, Literal

import numpy as np

from microrad.core.arrays import Floats
from microrad.core.budget import Line, root_sum_square
from microrad.core.units import format_beyond, format_quantity
from microrad.mission.fields import Bounded, Quantity, Share

WORST_CONDITION = 1e4
"""Ratio of the largest to the smallest gain from drives to line of sight beyond which a geometry is singular."""

NO_COUPLING = ((1.0, 0.0), (0.0, 1.0))
"""Each axis moves itself alone."""

_ANGLES, _LAYOUTS = ("optical", "mechanical"), ("two-axis", "tripod")
_PER_TILT = {"mechanical": 1.0, "optical": 2.0}  # what an output counts for one radian of tilt
_PUSHES_AT_RAD = 2.0 * np.pi / 3.0 * np.arange(3)


@dataclass(frozen=True, slots=True)
class Geometry(Bounded):
    """What stands between the mirror's outputs and the line of sight outside the telescope.

    ``angle``: a "mechanical" output counts the tilt, an "optical" one twice the tilt (the beam at normal incidence).
    ``incidence_rad``: angle of incidence; the beam turns by 2 times the x tilt and 2 cos(incidence) times the y tilt.
    ``magnification`` of the telescope: the line of sight turns by the beam's angle divided by it (an inverted image is
    a rotation by pi). ``rotation_rad``: the mirror's x moves the line of sight along (cos, sin) of it.
    ``coupling``: row j, column i is how much of axis i's own motion appears on axis j.

    ``layout`` "two-axis": the outputs are the x and y angles. "tripod": three actuators behind the mirror on a circle
    of ``actuator_radius_m``, at 0, 120 and 240 degrees from x towards y (``coupling`` turns them); the outputs are
    their extensions s over the radius, twice that if "optical". The plate z = p + a x + b y through the three points
    leans by (-a, -b) = -(2/3) sum of (s/radius) (cos, sin), away from an actuator that is pushed out, and rises by the
    mean extension p, the piston.

    Raises ValueError for a value without meaning, such as grazing incidence or a tripod without a radius.
    """

    angle: Literal["optical", "mechanical"]
    incidence_rad: Annotated[
        float,
        Share("rad", least=0.0, below=math.pi / 2.0),
        "between beam and normal; at pi/2 the beam grazes the mirror",
    ] = 0.0
    magnification: Annotated[float, Quantity("", above=0.0), "an inverted image is rotation_rad = pi"] = 1.0
    rotation_rad: Annotated[float, Quantity("rad")] = 0.0
    coupling: tuple[tuple[float, float], tuple[float, float]] = NO_COUPLING
    layout: Literal["two-axis", "tripod"] = "two-axis"
    actuator_radius_m: float | None = None

    def __post_init__(self) -> None:
        """Check each value."""
        _one_of("angle", self.angle, _ANGLES)
        _one_of("layout", self.layout, _LAYOUTS)
        Bounded.__post_init__(self)
        coupling = np.asarray(self.coupling, dtype=np.float64)
        if coupling.shape != (2, 2) or not np.all(np.isfinite(coupling)):
            raise ValueError(
                f"geometry: coupling is {self.coupling}; give two rows of two finite numbers, ((1, 0), (0, 1)) for none"
            )
        radius = self.actuator_radius_m
        if (self.layout == "tripod" or radius is not None) and not (radius is not None and 0.0 < radius < math.inf):
            raise ValueError(
                f"geometry: actuator_radius_m is {radius}; give the radius of the circle on which the tripod's three "
                "actuators stand, in m and above 0"
            )

    @property
    def outputs(self) -> int:
        """Number of the mirror's outputs, and of its actuators."""
        return 3 if self.layout == "tripod" else 2


def line_of_sight_matrix(geometry: Geometry) -> Floats:
    """Line-of-sight angles (x, y) from the mirror's outputs, shape (2, outputs), rad per rad, for small tilts."""
    beam = np.diag([2.0, 2.0 * math.cos(geometry.incidence_rad)]) / geometry.magnification
    c, s = math.cos(geometry.rotation_rad), math.sin(geometry.rotation_rad)
    turned = np.array([[c, -s], [s, c]]) @ beam @ np.asarray(geometry.coupling, dtype=np.float64)
    return np.asarray(turned @ _tilts(geometry) / _PER_TILT[geometry.angle])


def _tilts(geometry: Geometry) -> Floats:
    """Mechanical tilts (x, y) from mechanical outputs."""
    if geometry.layout == "two-axis":
        return np.eye(2)
    return -2.0 / 3.0 * np.array([np.cos(_PUSHES_AT_RAD), np.sin(_PUSHES_AT_RAD)])


def outputs_matrix(geometry: Geometry) -> Floats:
    """The mirror's outputs for line-of-sight angles (x, y), shape (outputs, 2): without piston for a tripod.

    Raises:
        ValueError: For a singular geometry.
    """
    seen = line_of_sight_matrix(geometry)
    _refuse_singular(geometry, seen)
    # Of a tripod's strokes that make a tilt, the pseudo-inverse takes the smallest, those without piston.
    strokes = np.linalg.pinv(_tilts(geometry))
    return np.asarray(strokes @ np.linalg.inv(seen @ strokes))


def _refuse_singular(geometry: Geometry, seen: Floats) -> None:
    directions, sizes, _ = np.linalg.svd(seen)
    if sizes[1] * WORST_CONDITION >= sizes[0] > 0.0:
        return
    weak = math.degrees(math.atan2(directions[1, 1], directions[0, 1])) % 180.0
    ratio = float(sizes[0] / sizes[1]) if sizes[1] > 0.0 else math.inf
    raise ValueError(
        f"geometry: the {geometry.layout} mirror is singular: at {weak:.1f} degrees from x towards y it moves the line "
        f"of sight {ratio:.3g} times less than across that direction (at most {WORST_CONDITION:g} can be decoupled); "
        "check coupling and incidence_rad"
    )


# ------------------------------------------------------------------------------------------------------- stroke budget
_DEMANDS = {
    "body_pointing_rad": "Body pointing",
    "point_ahead_rad": "Point-ahead",
    "bias_rad": "Bias and alignment",
    "rate_lag_rad": "Line-of-sight rate lag",
}


@dataclass(frozen=True, slots=True)
class StrokeDemand:
    """What the mirror has to follow: half ranges along the line-of-sight axes (x, y), rad, about the middle of travel.

    ``rate_lag_rad`` is how far the body trails a moving target, line-of-sight rate times the lag of the attitude
    control. Point-ahead counts only where it is ``point_ahead_on_mirror``; else another mirror makes it.

    Raises ValueError for a half range that is negative or not finite.
    """

    body_pointing_rad: tuple[float, float]
    point_ahead_rad: tuple[float, float]
    bias_rad: tuple[float, float]
    rate_lag_rad: tuple[float, float]
    point_ahead_on_mirror: bool

    def __post_init__(self) -> None:
        """Check each half range."""
        for key in _DEMANDS:
            pair = getattr(self, key)
            if np.shape(pair) != (2,) or not all(0.0 <= value < math.inf for value in pair):
                raise ValueError(
                    f"stroke budget: {key} is {pair}; give two half ranges (x, y) in rad, each finite and at least 0"
                )


@dataclass(frozen=True, slots=True)
class StrokeBudget:
    """Stroke that one output of the mirror needs, against half of the travel that it has.

    ``lines`` are half ranges of the line of sight along the direction that calls for this output, and
    ``mirror_per_line_of_sight`` takes them to the mirror's angle, counted as ``travel_angle`` says; needed, available
    and margin are counted so. ``travel_rad`` and ``usable_travel_rad`` run from stop to stop.

    The worst case is the sum of the lines. What ends in ``_rss`` takes their root sum square instead, which supposes
    them independent and of one class: ECSS-E-ST-60-10C does not grant that to bias and random together.
    """

    name: str
    lines: tuple[Line, ...]
    magnification: float
    mirror_per_line_of_sight: float
    travel_angle: str
    travel_rad: float
    usable_travel_rad: float

    @property
    def label(self) -> str:
        """What the output is: an axis, or an actuator of a tripod."""
        return f"axis {self.name}" if self.name in ("x", "y") else self.name

    @property
    def total_rad(self) -> float:
        """Half range at the line of sight, worst case."""
        return math.fsum(line.value for line in self.lines)

    @property
    def total_rss_rad(self) -> float:
        """Half range at the line of sight, root sum square."""
        return root_sum_square(self.lines)

    @property
    def needed_rad(self) -> float:
        """Half range at the mirror, worst case."""
        return self.mirror_per_line_of_sight * self.total_rad

    @property
    def needed_rss_rad(self) -> float:
        """Half range at the mirror, root sum square."""
        return self.mirror_per_line_of_sight * self.total_rss_rad

    @property
    def available_rad(self) -> float:
        """Half of the usable travel."""
        return self.usable_travel_rad / 2.0

    @property
    def usable_share(self) -> float:
        """Share of the travel that the drive range leaves, 0 to 1."""
        return self.usable_travel_rad / self.travel_rad

    @property
    def margin_rad(self) -> float:
        """Available less needed at the mirror, worst case."""
        return self.available_rad - self.needed_rad

    @property
    def margin_rss_rad(self) -> float:
        """Available less needed at the mirror, root sum square."""
        return self.available_rad - self.needed_rss_rad

    @property
    def ratio(self) -> float:
        """Available over needed, worst case; infinite where nothing is needed."""
        return self.available_rad / self.needed_rad if self.needed_rad else math.inf

    @property
    def ratio_rss(self) -> float:
        """Available over needed, root sum square; infinite where nothing is needed."""
        return self.available_rad / self.needed_rss_rad if self.needed_rss_rad else math.inf

    @property
    def fits(self) -> bool:
        """Whether the worst case stays within the usable travel."""
        return self.margin_rad >= 0.0

    @property
    def fits_rss(self) -> bool:
        """Whether the root sum square stays within the usable travel."""
        return self.margin_rss_rad >= 0.0

    @property
    def largest_magnification(self) -> float:
        """Magnification of the telescope at which the worst case would just fit."""
        return self.magnification * self.ratio

    @property
    def largest_magnification_rss(self) -> float:
        """Magnification of the telescope at which the root sum square would just fit."""
        return self.magnification * self.ratio_rss


def stroke_budget(
    geometry: Geometry,
    demand: StrokeDemand,
    *,
    travel_rad: float,
    travel_angle: Literal["optical", "mechanical"],
    usable_travel_rad: float | None = None,
    sources: Mapping[str, str] | None = None,
) -> tuple[StrokeBudget, ...]:
    """Compare the stroke that each output of the mirror needs with the travel that it has.

    There is one budget for each output: for x and y, or for the actuators 1 to 3 of a tripod. The demand may lie
    anywhere within its half ranges on both axes: an output called for by the line of sight along the unit vector d
    needs |d_x| x + |d_y| y, times the magnification, halved where the angle is mechanical.

    Args:
        geometry: What stands between the mirror's outputs and the line of sight.
        demand: Half ranges of the line of sight that the mirror has to follow.
        travel_rad: Travel of an output from stop to stop, above 0; of a tripod's actuator, its extension over the
            radius.
        travel_angle: What both travels count, whatever the model's outputs do: the tilt ("mechanical") or twice it
            ("optical").
        usable_travel_rad: What the drive range leaves of the travel, counted alike; all of it where none is given.
        sources: Where a half range comes from, by the name of its field of `StrokeDemand`.

    Raises:
        ValueError: For a travel that is not above zero, a usable travel beyond it, and a singular geometry.
    """
    usable = _usable_travel(travel_rad, usable_travel_rad)
    _one_of("travel_angle", travel_angle, _ANGLES, "stroke budget")
    rows = outputs_matrix(replace(geometry, angle=travel_angle))
    names = ("x", "y") if geometry.layout == "two-axis" else ("actuator 1", "actuator 2", "actuator 3")
    travel = Travel(travel_angle, travel_rad, usable)
    return budgets_of_rows(dict(zip(names, rows, strict=True)), geometry.magnification, demand, travel, sources or {})


@dataclass(frozen=True, slots=True)
class Travel:
    """Travel of an output from stop to stop (rad), what of it is usable, and what both count."""

    angle: str
    whole_rad: float
    usable_rad: float


def budgets_of_rows(
    rows: Mapping[str, Floats],
    magnification: float,
    demand: StrokeDemand,
    travel: Travel,
    sources: Mapping[str, str],
) -> tuple[StrokeBudget, ...]:
    """The stroke budget of each output or actuator, from what the line of sight calls for.

    Args:
        rows: By name, what takes an angle of 1 rad along each axis (x, y) of the line of sight, counted as the travel.
        magnification: Of the telescope.
        demand: Half ranges of the line of sight that the mirror has to follow.
        travel: What each has.
        sources: Where a half range comes from, by the name of its field of `StrokeDemand`.
    """
    return tuple(
        StrokeBudget(
            name=name,
            lines=_stroke_lines(demand, np.abs(row) / float(np.hypot(*row)), sources),
            magnification=magnification,
            mirror_per_line_of_sight=float(np.hypot(*row)),
            travel_angle=travel.angle,
            travel_rad=travel.whole_rad,
            usable_travel_rad=travel.usable_rad,
        )
        for name, row in rows.items()
    )


def _usable_travel(travel_rad: float, usable_travel_rad: float | None) -> float:
    if not 0.0 < travel_rad < math.inf:
        raise ValueError(f"stroke budget: travel_rad is {travel_rad:g}; give the range from stop to stop, above 0 rad")
    usable = travel_rad if usable_travel_rad is None else usable_travel_rad
    if not 0.0 < usable <= travel_rad:
        raise ValueError(
            f"stroke budget: usable_travel_rad is {format_beyond(usable, travel_rad, 'rad')}, of a travel of "
            f"{format_quantity(travel_rad, 'rad')} from stop to stop; give what the drive range leaves of that travel, "
            "above 0 rad and not beyond it"
        )
    return usable


def _stroke_lines(demand: StrokeDemand, along: Floats, sources: Mapping[str, str]) -> tuple[Line, ...]:
    """Half ranges of the line of sight along one direction; a term made elsewhere is a line of 0 rad."""
    lines = []
    for key, name in _DEMANDS.items():
        x, y = getattr(demand, key)
        elsewhere = key == "point_ahead_rad" and not demand.point_ahead_on_mirror
        value = 0.0 if elsewhere else float(along[0] * x + along[1] * y)
        half = f"half range at the line of sight: x {format_quantity(x, 'rad')}, y {format_quantity(y, 'rad')}"
        basis = f"{half}; made by another mirror" if elsewhere else f"{half}; along ({along[0]:.3g}, {along[1]:.3g})"
        lines.append(
            Line(name, value, "rad", basis, sources.get(key, "not stated"), "both axes at their worst together")
        )
    return tuple(lines)


def _one_of(key: str, value: object, choices: tuple[str, ...], where: str = "geometry") -> None:
    if value not in choices:
        raise ValueError(f"{where}: {key} is {value!r}; choose " + " or ".join(f'"{choice}"' for choice in choices))
