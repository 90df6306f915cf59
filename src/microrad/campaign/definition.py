"""A campaign as its file defines it, checked."""

from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from microrad.campaign.draws import Variable
from microrad.campaign.inputs import Base, Draw
from microrad.campaign.records import InputText, Limit
from microrad.campaign.tables import CampaignTable
from microrad.mission.file import LinkFile


class Dimension(NamedTuple):
    """A drawn column: its key and SI unit."""

    key: str
    unit: str


@dataclass(frozen=True, slots=True)
class CampaignFile:
    """A campaign with everything that it follows from.

    ``mission`` has the values of [set], and those of the first cell where it is no mission without them; ``bases`` are
    the missions of the cells, whose grid values as text are ``cells``. ``dimensions`` are the drawn columns in their
    order, said in words in ``inputs``; ``draws`` is what they come from. The ``rows`` of a cell are whole ``block`` s
    for Latin hypercube and Sobol sampling; ``most_rows`` is where a precision ends at last, ``rows`` without one.
    ``half_width`` is that of the precision in its output's SI unit, nan without. ``fixed`` are the texts of [set].
    ``loop_varies``: the loop differs from row to row. ``files`` are all that the campaign depends on, itself first.
    ``chunk_rows`` are the rows of a chunk where they were timed, None where their number follows from the rest.
    """

    path: Path
    text: str
    sha256: str
    table: CampaignTable
    mission: LinkFile
    cells: tuple[dict[str, str], ...]
    bases: tuple[Base, ...]
    draws: tuple[Draw, ...]
    dimensions: tuple[Dimension, ...]
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
