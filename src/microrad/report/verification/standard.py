"""What NASA-STD-7009B asks, and the records of this project that answer it."""

import re
import tomllib
from dataclasses import dataclass, field
from functools import cache
from importlib import resources
from typing import Any

STANDS = {
    "here": "answered in this report",
    "part": "met in part",
    "pages": "answered in the documentation",
    "mission": "answered in the report of each mission",
    "user": "for whoever uses the numbers",
    "open": "not met",
    "gone": "of revision A alone",
}
TEXTS = {
    "handbook": "handbook of revision A",
    "quoted": "quotations of revision B",
    "told": "summaries of revision B by others",
}
"""What a title is founded on; the standard itself was at hand for none."""


@dataclass(frozen=True, slots=True)
class Requirement:
    """A requirement, or several that are answered at one place.

    Args:
        number: In the standard.
        title: What is asked, in own words.
        stands: One of `STANDS`.
        text: What the title is founded on, one of `TEXTS`.
        sections: Anchors in the verification report.
        pages: Of the documentation.
        part: Heading in the report of a mission.
        said: What else is to be said.
    """

    number: str
    title: str
    stands: str
    text: str
    sections: list[str] = field(default_factory=list)
    pages: list[str] = field(default_factory=list)
    part: str = ""
    said: str = ""

    @property
    def numbers(self) -> list[int]:
        """Each number that stands here, also those of a range."""
        spans = re.findall(r"(\d+)(?: to (\d+))?", self.number)
        return [number for first, last in spans for number in range(int(first), int(last or first) + 1)]


@dataclass(frozen=True, slots=True)
class Assumption:
    """What a part of the chain assumes, why, and what follows where it does not hold."""

    part: str
    assumed: str
    because: str
    otherwise: str


@dataclass(frozen=True, slots=True)
class Uncertainty:
    """Which estimate of uncertainty the quantities of a subject have, and how it is obtained."""

    subject: str
    kind: str
    estimate: str
    how: str


@cache
def _read() -> dict[str, Any]:
    return tomllib.loads(resources.files("microrad.report.verification").joinpath("standard.toml").read_text("utf-8"))


@cache
def requirements() -> tuple[Requirement, ...]:
    """All requirements by their number, those of revision A alone first."""
    return tuple(Requirement(**each) for each in _read()["requirements"])


@cache
def assumptions() -> tuple[Assumption, ...]:
    """Of the chain, from its links to its day."""
    return tuple(Assumption(**each) for each in _read()["assumptions"])


@cache
def uncertainties() -> tuple[Uncertainty, ...]:
    """One for each subject of the register."""
    return tuple(Uncertainty(**each) for each in _read()["uncertainty"])


def level_means(factor: str, level: int) -> str:
    """What a level of a factor of credibility asks for by the standard's scale.

    Args:
        factor: Its name.
        level: 0 to 4.
    """
    words: list[str] = _read()["scale"][factor]
    return words[level - 1] if level else "insufficient evidence"
