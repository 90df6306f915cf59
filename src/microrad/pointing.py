"""Open-loop pointing: the errors that the beacon has to cover before anything is tracked."""

from collections.abc import Mapping
from dataclasses import dataclass

from microrad.budget import Line, root_sum_square
from microrad.mission import Mission, Source, half_angle_rad, source_text

_CONVENTIONS = ("full-1/e2", "half-1/e2")
_TERMS = (
    ("Orbit knowledge", "orbit_knowledge"),
    ("Body pointing", "body_pointing"),
    ("Misalignment", "misalignment"),
)
_BASIS = "half width about the line of sight, as given"
_REGIME = "independent of the other lines and of their class: ECSS-E-ST-60-10C does not add bias and random in squares"


@dataclass(frozen=True, slots=True)
class DivergenceReading:
    """What the beacon covers when its divergence is read by `convention`, "full-1/e2" or "half-1/e2".

    `required_divergence_rad` is the divergence, in that convention, whose half angle equals the root sum square.
    """

    convention: str
    half_angle_rad: float
    required_divergence_rad: float
    covers: bool


@dataclass(frozen=True, slots=True)
class OpenLoopPointing:
    """Open-loop pointing errors, their root sum square and whether the beacon's half angle at 1/e2 covers it.

    `variance_shares` is the part of each line in the sum of squares; zeros when every line is zero. The beacon is read
    by the mission's own convention; `other_reading` is the same question under the other one.
    """

    lines: tuple[Line, ...]
    variance_shares: tuple[float, ...]
    rss_rad: float
    convention: str
    beacon_half_angle_rad: float
    required_divergence_rad: float
    covers: bool
    other_reading: DivergenceReading


def open_loop_budget(mission: Mission, sources: Mapping[str, Source]) -> OpenLoopPointing:
    """Root sum square of the open-loop errors against the beacon (paper, section 2.1: 780 µrad cover them)."""
    lines = tuple(
        Line(
            name,
            getattr(mission.pointing, f"{key}_rad"),
            "rad",
            _BASIS,
            source_text(sources, f"pointing.{key}"),
            _REGIME,
        )
        for name, key in _TERMS
    )
    rss = root_sum_square(lines)
    own = mission.conventions.divergence
    other = next(convention for convention in _CONVENTIONS if convention != own)
    reading = _reading(mission.beacon.divergence_rad, own, rss)
    return OpenLoopPointing(
        lines=lines,
        variance_shares=tuple((line.value / rss) ** 2 if rss else 0.0 for line in lines),
        rss_rad=rss,
        convention=own,
        beacon_half_angle_rad=reading.half_angle_rad,
        required_divergence_rad=reading.required_divergence_rad,
        covers=reading.covers,
        other_reading=_reading(mission.beacon.divergence_rad, other, rss),
    )


def _reading(divergence_rad: float, convention: str, rss_rad: float) -> DivergenceReading:
    half = half_angle_rad(divergence_rad, convention)
    per_half = divergence_rad / half  # 2 for a full angle, 1 for a half angle
    return DivergenceReading(convention, half, per_half * rss_rad, half >= rss_rad)
