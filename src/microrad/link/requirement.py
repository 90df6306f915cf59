"""What is required of a mission's links: a line for each requirement, with its margin and what limits it."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

from microrad import link
from microrad.link.budget.lines import FREE_SPACE_LOSS
from microrad.link.pointing import OpenLoopPointing
from microrad.link.pointing.outage import stated_outage
from microrad.link.study import LinkStudy
from microrad.mission.model import Source
from microrad.mission.tables.link import LinkRequirement

Subject = Literal["cone", "beacon", "answer", "communication", "residual", "stroke", "fine pointing", "error budget"]
"""What a requirement is about: the beacon's cone, a margin, the error that a loop leaves, the mirror's stroke, or what
the budget of pointing errors comes to."""

ROUNDING = 1e-9
"""Share of a number, or decibels, that rounding may take from it."""

UNDER_FADES = "communication margin under fades"
"""The name of the margin that a series of received power leaves."""

DERIVED = "derived"
"""Mark of a requirement that is met by the choice of an input."""

IMPOSSIBLE = "its budget has more light arrive than was sent: the terminals are too near for it"


@dataclass(frozen=True, slots=True)
class Requirement:
    """One line of the verdict, in one unit, "%" for a share; ``margin`` is positive when it is met.

    ``unknown`` says, where it is not empty, what would have to be known before the number may be relied on: such a
    requirement is not met, whatever its margin. ``derived`` are inputs of it that were chosen so that something is met,
    with what they were derived from: that such a requirement is met says nothing of the terminal.
    """

    subject: Subject
    name: str
    unit: str
    required: float
    actual: float
    margin: float
    limited_by: str
    unknown: str = ""
    derived: tuple[str, ...] = ()

    @property
    def met(self) -> bool:
        """Whether the requirement is met; a rate that was solved for meets it but for rounding."""
        size = max(abs(self.required), abs(self.actual), 1.0 if self.unit == "dB" else 0.0)
        spared = ROUNDING * size if math.isfinite(size) else 0.0  # no rounding makes up for what is infinitely short
        return self.margin >= -spared and not self.unknown

    @property
    def mark(self) -> str:
        """PASS or FAIL, or `DERIVED` where it is met by the choice of an input."""
        return "FAIL" if not self.met else DERIVED if self.derived else "PASS"

    @property
    def because(self) -> str:
        """What limits it, or what is not known."""
        return self.unknown or self.limited_by


def of_links(study: LinkStudy) -> tuple[Requirement, ...]:
    """The requirements that the budgets alone can answer: those of the beacon, the answer and communication."""
    m = study.file.mission
    name = "communication margin" + ("" if m.jitter is None else f" for {time_kept(m.requirement)}")
    return (
        *of_beams(study),
        _of_budget(study.file.sources, "communication", study.communication, m.requirement.margin_db, name),
        *of_fading(study),
    )


def of_fading(study: LinkStudy) -> tuple[Requirement, ...]:
    """The margin that a series of received power leaves, where the mission names one."""
    found, required = study.fading, study.file.mission.requirement.margin_db
    if found is None:
        return ()
    left = found.margin_left_db
    return (Requirement("communication", UNDER_FADES, "dB", required, left, left - required, "fades of the series"),)


def met(study: LinkStudy) -> bool:
    """Whether the links meet all that is required of them."""
    return all(r.met for r in of_links(study))


def of_beams(study: LinkStudy) -> tuple[Requirement, ...]:
    """The requirements of beacon and answer, where the mission has them: the beacon's cone, and 0 dB of each."""
    sources, found = study.file.sources, []
    if study.beacon is not None:
        assert study.open_loop is not None  # it has a beacon
        found += [_cone(study.open_loop, sources), _of_budget(sources, "beacon", study.beacon)]
    if study.answer is not None:
        found.append(_of_budget(sources, "answer", study.answer))
    return tuple(found)


def time_kept(required: LinkRequirement) -> str:
    """The share of the time for which the required margin has to be there."""
    return f"{100.0 * (1.0 - stated_outage(required)):.6g} % of the time"


def derived_from(sources: Mapping[str, Source], *keys: str) -> tuple[str, ...]:
    """The inputs whose source calls them derived, each in words with its value and what it is derived from.

    A value that was changed since is none of them.

    Args:
        sources: Where each value of the mission comes from, by its dotted key.
        *keys: Beginnings of the dotted keys looked at.
    """
    found = [(key, s) for key, s in sources.items() if s.kind == "derived" and not s.was and key.startswith(keys)]
    unquoted = ((key, s.value.strip('"'), s.comment.partition(": ")[2]) for key, s in found)
    return tuple(f"{key} = {value} ({what})" for key, value, what in unquoted)


def _cone(p: OpenLoopPointing, sources: Mapping[str, Source]) -> Requirement:
    """How often the beacon has its partner inside its cone: the exact share, both axes and biases counted.

    Errors that were derived from the cone by their root sum square, as in the paper, are held against that alone: it
    is one axis, and meeting it proves nothing.
    """
    assert p.reading is not None  # there is a beacon
    derived = derived_from(sources, "pointing.", "beacon.divergence")
    largest = max(zip(p.variance_shares, p.lines, strict=True), key=lambda pair: pair[0])[1].name
    if derived:
        half, name = p.beacon_half_angle_rad, "beacon cone over the root sum square"
        return Requirement("cone", name, "rad", p.rss_rad, half, half - p.rss_rad, largest, derived=derived)
    wanted, covered = 100.0 * p.confidence, 100.0 * p.reading.coverage
    return Requirement("cone", "beacon covers its partner", "%", wanted, covered, covered - wanted, largest)


def _of_budget(
    sources: Mapping[str, Source], subject: Subject, budget: link.LinkBudget, required_db: float = 0.0, name: str = ""
) -> Requirement:
    # Free space is lost by everyone: name the largest loss that a design can change.
    losses = [line for line in budget.lines if line.unit == "dB" and line.name != FREE_SPACE_LOSS]
    limit, spare = min(losses, key=lambda line: line.value).name, budget.margin_db - required_db
    doubt, derived = "" if budget.possible else IMPOSSIBLE, derived_from(sources, f"{subject}.")
    return Requirement(
        subject, name or f"{subject} margin", "dB", required_db, budget.margin_db, spare, limit, doubt, derived
    )
