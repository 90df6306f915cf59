"""The open-loop pointing budget of a mission: the errors that the beacon has to cover before anything is tracked."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from numpy.typing import ArrayLike

from microrad.core.arrays import Floats
from microrad.core.budget import Line, root_sum_square
from microrad.core.units import format_quantity
from microrad.link.budget.assembly import Shared
from microrad.link.pointing.error_classes import ErrorTerm, Interpretation, StatedError, basis, error_term
from microrad.link.pointing.summation import (
    Allocation,
    Rule,
    Summation,
    allocate,
    exact_total_rad,
    mean_and_sigma,
    summations,
)
from microrad.link.radial_error import Jitter, radial_cdf
from microrad.mission.model import Source, source_text
from microrad.mission.tables.link import Beacon, half_angle_rad
from microrad.mission.tables.pointing import PointAhead, Pointing, point_ahead_rad

NAME = "Point-ahead"
"""What the budget calls its line."""


@dataclass(frozen=True, slots=True)
class PointAheadAngle:
    """The point-ahead angle of a mission, and what the budget has to carry of it.

    `error_rad` is what the correction leaves, radial, or the whole angle about one axis when `corrected` is false.
    """

    angle_rad: float
    corrected: bool
    error_rad: float

    @property
    def stated(self) -> StatedError:
        """The line of the budget: a constant error, and its largest value."""
        return StatedError(NAME, self.error_rad, "bias", "bound", "radial" if self.corrected else "x")

    @property
    def basis(self) -> str:
        """How the line comes about."""
        shown = format_quantity(self.angle_rad, "rad", 3)
        return f"what correcting {shown} leaves" if self.corrected else f"2 v / c = {shown}, not corrected"


def point_ahead(table: PointAhead) -> PointAheadAngle:
    """The point-ahead angle of a mission, and the error that it leaves."""
    angle = point_ahead_rad(table.transverse_velocity_m_s)
    return PointAheadAngle(angle, table.corrected, table.error_rad if table.corrected else angle)


_CONVENTIONS = ("full-1/e2", "half-1/e2")
_REGIME = "uncorrelated with the other lines"
_OWN_FORMULA = f"{_REGIME}; our own formula, ECSS-E-ST-60-10C has no such class"


@dataclass(frozen=True, slots=True)
class DivergenceReading:
    """What the beacon covers when its divergence is read by `convention`, "full-1/e2" or "half-1/e2".

    `covers` says whether the half angle is at least the root sum square, `required_divergence_rad` is the divergence,
    in that convention, for which they are equal. `coverage` is the probability that the radial error is below the half
    angle, and `confident_divergence_rad` is the divergence for which it is the mission's confidence.
    """

    convention: str
    half_angle_rad: float
    required_divergence_rad: float
    covers: bool
    coverage: float
    confident_divergence_rad: float


@dataclass(frozen=True, slots=True)
class OpenLoopPointing:
    """Open-loop pointing errors, their totals by each rule, and what the beacon covers of them.

    `lines` hold the stated half widths, `terms` in the same order what they mean: mean and standard deviation about x
    and y. `variance_shares` is the part of each line in the sum of squared half widths; zeros when every line is zero.
    `error` is mean and standard deviation of the sum. `confidence` is a share of the time of the worst-case
    satellite ("temporal") or of the times of all satellites ("mixed"), as `interpretation` says: see `error_term`.

    `convention` is the mission's own for a divergence. `required_divergence_rad` has the root sum square as its half
    angle, `confident_divergence_rad` covers with the mission's confidence. `reading` and its counterpart under the
    other convention, `counter_reading`, are None for a mission without a beacon.
    """

    lines: tuple[Line, ...]
    stated: tuple[StatedError, ...]
    terms: tuple[ErrorTerm, ...]
    variance_shares: tuple[float, ...]
    rss_rad: float
    confidence: float
    interpretation: Interpretation
    error: Jitter
    summations: tuple[Summation, ...]
    point_ahead: PointAheadAngle | None
    convention: str
    required_divergence_rad: float
    confident_divergence_rad: float
    reading: DivergenceReading | None
    counter_reading: DivergenceReading | None

    def total_rad(self, rule: str) -> float:
        """The total by a rule: "rss", "esa-1993", "ecss-axis", "ecss-radial", "rayleigh" or "exact".

        Raises ValueError for another.
        """
        for each in self.summations:
            if each.rule == rule:
                return each.total_rad
        raise ValueError(f'no rule "{rule}"; give one of {", ".join(each.rule for each in self.summations)}')

    def coverage(self, radius_rad: ArrayLike) -> Floats:
        """Probability that the radial error is below each radius, for instance where the beacon's power suffices.

        Exact for the Gaussian of `error`. Raises ValueError for a negative radius.
        """
        return radial_cdf(self.error, radius_rad)

    def allocation(self, total_rad: float, rule: Rule = "ecss-radial") -> tuple[Allocation, ...]:
        """What a total leaves for each line, the others unchanged.

        Args:
            total_rad: The total to meet, in rad.
            rule: The rule by which the lines are summed, out of `TOTALS`.

        Raises:
            ValueError: As `allocate`.
        """
        return allocate(
            self.stated, total_rad, rule=rule, confidence=self.confidence, interpretation=self.interpretation
        )

    @property
    def beacon_half_angle_rad(self) -> float:
        """Half angle of the beacon at 1/e2; raises ValueError for a mission without one, as the two below."""
        return _of_beacon(self.reading).half_angle_rad

    @property
    def covers(self) -> bool:
        """Whether the beacon's half angle at 1/e2 is at least the root sum square."""
        return _of_beacon(self.reading).covers

    @property
    def other_reading(self) -> DivergenceReading:
        """The same beacon with its divergence read by the other convention."""
        return _of_beacon(self.counter_reading)


def open_loop_budget(
    pointing: Pointing | None,
    shared: Shared,
    beacon: Beacon | None,
    sources: Mapping[str, Source],
    *,
    interpretation: Interpretation = "temporal",
) -> OpenLoopPointing:
    """Open-loop errors by every rule against the beacon (paper, section 2.1: 780 µrad cover their root sum square).

    Point-ahead is a line where the mission has it.

    Args:
        pointing: The mission's table of errors and confidence.
        shared: Terminals, conventions and point-ahead of the mission.
        beacon: The beam that has to cover the errors; None where the mission has none.
        sources: Where each value of the mission comes from, by key.
        interpretation: Of all lines. "temporal": the confidence is a share of the time of the worst-case satellite,
            "mixed": of the times of all satellites; see `error_term`.

    Raises:
        ValueError: If the mission states no pointing errors, or a line stands for point-ahead as well.
    """
    if pointing is None:
        raise ValueError("the mission states no pointing errors; give it the table [pointing]")
    ahead = None if shared.point_ahead is None else point_ahead(shared.point_ahead)
    entries = tuple(_entries(pointing, ahead, sources, interpretation))
    lines, stated = tuple(line for line, _ in entries), tuple(error for _, error in entries)
    terms = tuple(error_term(error, interpretation) for error in stated)
    confidence, rss, error = pointing.confidence, root_sum_square(lines), mean_and_sigma(terms)
    confident = exact_total_rad(terms, confidence)
    own = shared.conventions.divergence
    other = next(convention for convention in _CONVENTIONS if convention != own)

    def reading(convention: str) -> DivergenceReading | None:
        if beacon is None:
            return None
        half = half_angle_rad(beacon.divergence_rad, convention)
        needed = _divergence_rad(rss, convention), _divergence_rad(confident, convention)
        inside = float(radial_cdf(error, half))
        return DivergenceReading(convention, half, needed[0], half >= rss, inside, needed[1])

    return OpenLoopPointing(
        lines=lines,
        stated=stated,
        terms=terms,
        variance_shares=tuple((term.stated_rad / rss) ** 2 if rss else 0.0 for term in terms),
        rss_rad=rss,
        confidence=confidence,
        interpretation=interpretation,
        error=error,
        summations=summations(terms, confidence),
        point_ahead=ahead,
        convention=own,
        required_divergence_rad=_divergence_rad(rss, own),
        confident_divergence_rad=_divergence_rad(confident, own),
        reading=reading(own),
        counter_reading=reading(other),
    )


def _entries(
    pointing: Pointing, ahead: PointAheadAngle | None, sources: Mapping[str, Source], interpretation: Interpretation
) -> Iterator[tuple[Line, StatedError]]:
    for key, line in pointing.lines.items():
        name = key.replace("_", " ").replace("-", " ").strip().capitalize()
        if ahead is not None and name.lower() == NAME.lower().replace("-", " "):
            raise ValueError(
                f"pointing.lines.{key} stands beside the table point_ahead, which is a line of the budget already; "
                "remove one of the two"
            )
        stated = StatedError(name, line.error_rad, line.kind, line.statistic, line.axes)
        yield _line(stated, basis(stated, interpretation), source_text(sources, f"pointing.lines.{key}.error")), stated
    if ahead is not None:
        key = "point_ahead.error" if ahead.corrected else "point_ahead.transverse_velocity"
        text = f"{ahead.basis}; {basis(ahead.stated, interpretation)}"
        yield _line(ahead.stated, text, source_text(sources, key)), ahead.stated


def _line(stated: StatedError, text: str, source: str) -> Line:
    regime = _OWN_FORMULA if stated.kind in ("drift", "transient") else _REGIME
    return Line(stated.name, stated.error_rad, "rad", text, source, regime)


def _divergence_rad(half_rad: float, convention: str) -> float:
    return half_rad / half_angle_rad(1.0, convention)


def _of_beacon(reading: DivergenceReading | None) -> DivergenceReading:
    if reading is None:
        raise ValueError("the mission has no beacon, so nothing is covered; give it a table [beacon]")
    return reading
