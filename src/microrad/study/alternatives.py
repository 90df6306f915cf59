"""What the verdict would be by other readings of what the paper leaves open, each changed alone."""

import math
from dataclasses import dataclass
from typing import Any, get_args

from microrad import link, mirror
from microrad.core import kept
from microrad.loop import paper_cases
from microrad.mirror import Variant
from microrad.mission.model import Conventions, Mission, Requirement
from microrad.mission.tables.link import UNUSED
from microrad.mission.tables.mirror import Mirror

_OPEN: tuple[tuple[str, type[Any]], ...] = (
    ("conventions.residual", Conventions),
    ("conventions.pointing_loss", Conventions),
    ("conventions.strehl", Conventions),
    ("conventions.mirror_angle", Conventions),
    ("requirement.residual_statistic", Requirement),
    ("mirror.composition", Mirror),
)
"""Keys with a few readings to choose from, and the table that names them."""
_SIMULATED = ("conventions.mirror_angle", "mirror.composition")


@dataclass(frozen=True, slots=True)
class Reading:
    """One key read in another way, all else as it is: the residual (rad) and the margin of the communication link (dB).

    ``failure`` says why there are none, where the loop cannot be run so; both are nan then.
    """

    key: str
    given: str
    other: str
    residual_rad: float
    margin_db: float
    failure: str = ""

    @property
    def closes(self) -> bool:
        """Whether the communication link has a margin of 0 dB at least."""
        return self.margin_db >= 0.0

    def meets(self, q: Requirement) -> bool:
        """Whether both requirements that rest on the residual are met."""
        return self.residual_rad <= q.pointing_error_rad and self.margin_db >= q.margin_db


def other_readings(m: Mission, residual: paper_cases.Run, parts: kept.Kept = kept.NOTHING) -> tuple[Reading, ...]:
    """Every other reading that fits the mission's other tables.

    Readings of the loop are simulated (PID + inverse at the mission's frequencies); the others read one run anew.

    Args:
        m: The mission as it is.
        residual: The run that the verdict rests on.
        parts: The runs of earlier studies that are kept.
    """
    found = []
    for key, table in _OPEN:
        section, _, name = key.partition(".")
        given = str(getattr(getattr(m, section), name))
        for other in get_args(table.model_fields[name].annotation):
            as_read, run = m.with_value(key, other), residual
            if other in (given, UNUSED) or [*as_read.problems(), *as_read.mirror.problems()]:
                continue
            try:
                if key in _SIMULATED:
                    cases = paper_cases.of(as_read, mirror.of(as_read))
                    run = parts.part(_largest, cases, as_read.requirement.residual_statistic)
                left = paper_cases.residual_rad(as_read.requirement, as_read.conventions, run.trace)
                margin_db = float(link.margin_of_error(link.of(as_read), left))
                found.append(Reading(key, given, other, left, margin_db))
            except ValueError as error:  # an unstable loop, a mirror without an inverse
                found.append(Reading(key, given, other, math.nan, math.nan, str(error)))
    return tuple(found)


def _largest(cases: paper_cases.PaperCases, statistic: str) -> paper_cases.Run:
    """The run on the mission's mirror that leaves the largest error."""
    return paper_cases.worst(paper_cases.sine_runs(cases, (Variant.GIVEN,)), statistic)
