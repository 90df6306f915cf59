"""A campaign as its file defines it, checked: the cells of its grid, what is drawn, and the bounds of its variables."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from microrad.campaign.definition.distributions import Distribution, OneOf
from microrad.campaign.definition.keys import MIRROR
from microrad.campaign.definition.outputs import OUTPUTS, TAIL_OUTPUTS, Output
from microrad.campaign.definition.tables import CampaignTable
from microrad.campaign.records import InputText, Limit
from microrad.mirror import coupled
from microrad.mission.file import LinkFile
from microrad.mission.model import Mission
from microrad.mission.tables.mirror import Mirror

_FILE_KEYS = (".file", ".mirror_file", ".series")
"""How the keys of a mission end that name a file."""

_LOG_RATIO = 10.0
"""A variable is searched on a logarithmic scale where its bounds are at least this far apart."""


@dataclass(frozen=True, slots=True)
class Cell:
    """A cell of the grid: its values as text, the raw data of its mission, and that mission.

    ``several_axes`` is the mirror that ``fine_pointing.mirror_file`` names, where the campaign draws it.
    """

    values: dict[str, str]
    data: Mapping[str, Any]
    file: LinkFile
    several_axes: coupled.CoupledMirror | None = None

    @property
    def mirror(self) -> Mirror | None:
        """The mirror of one axis of its mission, None where that has links alone."""
        m = self.file.mission
        return m.mirror if isinstance(m, Mission) else None

    @property
    def directions(self) -> tuple[str, ...]:
        """Columns of the standard normal numbers that a row moves ``several_axes`` by; none without it."""
        count = 0 if self.several_axes is None else coupled.directions(self.several_axes)
        return tuple(f"{MIRROR}.{number}" for number in range(1, count + 1))

    @property
    def label(self) -> str:
        """The values of the grid in words, "" without a grid."""
        return ", ".join(f"{key} = {text}" for key, text in self.values.items())


@dataclass(frozen=True, slots=True)
class Draw:
    """An input that is drawn: the covariance of an identified mirror where there is no ``distribution``.

    With ``drawn_as`` its values are drawn from that distribution instead, and weighted.
    """

    key: str
    unit: str
    distribution: Distribution | None
    drawn_as: Distribution | None

    @property
    def files(self) -> tuple[str, ...]:
        """The files that it draws from, as they are named; none of another key."""
        if isinstance(self.distribution, OneOf) and self.key.endswith(_FILE_KEYS):
            return tuple(str(word) for word in self.distribution.written)
        return ()


@dataclass(frozen=True, slots=True)
class Variable:
    """A design variable: its mission key, its SI unit ("" for a plain number), and the bounds that it stays within."""

    key: str
    unit: str
    low: float
    high: float

    @property
    def log(self) -> bool:
        """Whether equal ratios, and not equal differences, are equal steps of the search."""
        return self.low > 0.0 and self.high >= _LOG_RATIO * self.low

    def at(self, place: float) -> float:
        """Value at a place from 0 (low) to 1 (high)."""
        value = self.low * (self.high / self.low) ** place if self.log else self.low + place * (self.high - self.low)
        return float(min(max(value, self.low), self.high))


@dataclass(frozen=True, slots=True)
class CampaignFile:
    """A campaign with everything that it follows from.

    ``mission`` has the values of [set], and those of the first cell where it is no mission without them. ``inputs`` are
    the drawn columns in their order, in words; ``draws`` is what they come from. The ``rows`` of a cell are whole
    ``block`` s for Latin hypercube and Sobol sampling; ``most_rows`` is where a precision ends at last, ``rows``
    without one. ``half_width`` is that of the precision in its output's SI unit, nan without. ``fixed`` are the texts
    of [set]. ``loop_varies``: the loop differs from row to row. ``files`` are all that the campaign depends on, itself
    first. ``chunk_rows`` are the rows of a chunk where they were timed, None where their number follows from the rest.
    """

    path: Path
    text: str
    sha256: str
    table: CampaignTable
    mission: LinkFile
    cells: tuple[Cell, ...]
    draws: tuple[Draw, ...]
    inputs: tuple[InputText, ...]
    fixed: dict[str, str]
    keep: tuple[str, ...]
    limits: tuple[Limit, ...]
    variables: tuple[Variable, ...]
    rows: int
    most_rows: int
    realisations: int
    block: int
    half_width: float
    loop_varies: bool
    files: tuple[Path, ...]
    warnings: tuple[str, ...]
    chunk_rows: int | None = None

    @property
    def outputs(self) -> tuple[Output, ...]:
        """The outputs that each row has, in their order."""
        if self.table.tail is not None:
            return tuple(TAIL_OUTPUTS.values())
        return tuple(OUTPUTS[name] for name in self.keep)
