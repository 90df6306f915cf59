"""Which rows a campaign has, in which chunks: whoever does the work.

It follows from the campaign file alone, but for the chunks of links alone, which are cut to what their rows cost where
the campaign begins. No number depends on that.
"""

import math
from dataclasses import dataclass

from microrad.campaign.definition.records import CampaignFile
from microrad.campaign.definition.tables import LoopTable
from microrad.campaign.records import Job
from microrad.campaign.rows import loops
from microrad.core import kernels

_CHUNK_STEPS = 2e7  # plant steps of all runs in a chunk: about a second
_CHUNK_S = 2.0  # at most, of rows that were timed
_CHUNK_ROWS = 1024  # at most
_DAY_ROWS = 8  # with outputs of the day, which take a second each
_GROWTH = 1.5  # of the rows from one round to the next, until the precision is reached


@dataclass(frozen=True, slots=True)
class Plan:
    """The rows of each cell in rounds and chunks.

    ``chunk_rows`` are the rows in a chunk: a power of two, about a second of work. ``largest_chunk`` are those as far
    as the file says it: a power of two that holds whole chunks. ``rounds`` are the rows of a cell at the end of each
    round, rising: one round, or more until a wanted precision is reached. ``is_timed``: what a row costs does not
    follow from the file, as it is for links alone, by their beams and receivers.
    """

    chunk_rows: int
    largest_chunk: int
    rounds: tuple[int, ...]
    is_timed: bool

    def chunks(self, cell: int, rows: int) -> list[Job]:
        """The chunks that the first rows of a cell are in.

        Args:
            cell: the cell.
            rows: how many rows.
        """
        return [Job(cell, number) for number in range(-(-rows // self.chunk_rows))]

    def rows_of(self, number: int) -> range:
        """The rows of a chunk; the last one of a campaign may be shorter."""
        return range(number * self.chunk_rows, min((number + 1) * self.chunk_rows, self.rounds[-1]))

    def timed_chunk(self, row_s: float) -> int:
        """Rows in a chunk where each takes so long (s)."""
        return min(1 << int(math.log2(max(_CHUNK_S / max(row_s, 1e-9), 1.0))), self.largest_chunk)


def planned(campaign: CampaignFile) -> Plan:
    """The plan of a campaign."""
    has_day = any(output.group == "day" for output in campaign.outputs)
    few = 1 << int(math.log2(campaign.rows))
    if campaign.table.loop is not None and not has_day:
        largest = _rows_of_a_second(campaign, campaign.table.loop, few)
    else:
        largest = min(_DAY_ROWS if has_day else _CHUNK_ROWS, few)
    is_timed = campaign.table.loop is None and not has_day
    return Plan(campaign.chunk_rows or largest, largest, _rounds(campaign, largest), is_timed)


def _rows_of_a_second(campaign: CampaignFile, table: LoopTable, few: int) -> int:
    """Rows that are simulated in about a second, a power of two: ``few`` at most, but whole batches of the loop."""
    own, f = campaign.realisations, loops.settings(campaign.mission)
    lanes = kernels.LANES * math.ceil(own / kernels.LANES) if campaign.loop_varies else own
    steps = loops.span(table, f, campaign.table.seed).duration_s / f.plant_step_s * lanes
    full = 1 if campaign.loop_varies else math.ceil(kernels.LANES / own)  # rows that fill the lanes of a batch
    wanted = max(_CHUNK_STEPS / steps, 1.0)
    return max(min(1 << int(math.log2(wanted)), _CHUNK_ROWS, few), 1 << math.ceil(math.log2(full)))


def _rounds(campaign: CampaignFile, largest_chunk: int) -> tuple[int, ...]:
    """Rows of a cell at the end of each round.

    With a precision each round has whole chunks and blocks, so that what is done does not depend on where it stops;
    the last one ends at the most rows that are wanted, or less than a chunk or block before. Where these are less than
    a chunk or block, there is one round, of all of them.
    """
    wanted = campaign.table.precision
    if wanted is None:
        return (campaign.rows,)
    unit = max(largest_chunk, campaign.block)  # powers of two, so the larger holds whole ones of the other
    totals, most = [-(-campaign.rows // unit) * unit], wanted.at_most // unit * unit
    if totals[0] > campaign.most_rows:
        return (campaign.most_rows,)
    while totals[-1] < most:
        totals.append(min(-(-math.ceil(_GROWTH * totals[-1]) // unit) * unit, most))
    return tuple(totals)
