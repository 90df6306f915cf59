"""Which rows a campaign has, in which chunks: whoever does the work.

It follows from the campaign file alone, but for the chunks of links alone, which are cut to what their rows cost where
the campaign begins. No number depends on that.
"""

import math
from dataclasses import replace

from microrad.campaign import loops
from microrad.campaign.definition import CampaignFile
from microrad.campaign.outputs import OUTPUTS, TAIL_OUTPUTS, Output
from microrad.campaign.records import Job
from microrad.core import kernels

_CHUNK_STEPS = 2e7  # plant steps of all runs in a chunk: about a second
_CHUNK_S = 2.0  # at most, of rows that were timed
_CHUNK_ROWS = 1024  # at most
_DAY_ROWS = 8  # with outputs of the day, which take a second each
_GROWTH = 1.5  # of the rows from one round to the next, until the precision is reached


def outputs(campaign: CampaignFile) -> tuple[Output, ...]:
    """The outputs that each row has, in their order."""
    if campaign.table.tail is not None:
        return tuple(TAIL_OUTPUTS.values())
    return tuple(OUTPUTS[name] for name in campaign.keep)


def chunk_rows(campaign: CampaignFile) -> int:
    """Rows in a chunk: a power of two, about a second of work."""
    return campaign.chunk_rows or largest_chunk(campaign)


def is_timed(campaign: CampaignFile) -> bool:
    """Whether what a row costs does not follow from the file: that of links alone, by their beams and receivers."""
    return campaign.table.loop is None and all(output.group != "day" for output in outputs(campaign))


def timed(campaign: CampaignFile, row_s: float) -> CampaignFile:
    """The campaign with chunks of rows that take this long each."""
    rows = 1 << int(math.log2(max(_CHUNK_S / max(row_s, 1e-9), 1.0)))
    return replace(campaign, chunk_rows=min(rows, largest_chunk(campaign)))


def largest_chunk(campaign: CampaignFile) -> int:
    """Rows in a chunk as far as the file says it: a power of two, as `chunk_rows`, which holds whole ones of those."""
    few = 1 << int(math.log2(campaign.rows))
    if any(output.group == "day" for output in outputs(campaign)):
        return min(_DAY_ROWS, few)
    if campaign.table.loop is None:
        return min(_CHUNK_ROWS, few)
    fine, own = loops.settings(campaign.mission), campaign.realisations
    lanes = kernels.LANES * math.ceil(own / kernels.LANES) if campaign.loop_varies else own
    steps = loops.span(campaign, fine).duration_s / fine.plant_step_s * lanes
    full = 1 if campaign.loop_varies else math.ceil(kernels.LANES / own)  # rows that fill the lanes of a batch
    wanted = max(_CHUNK_STEPS / steps, 1.0)
    return max(min(1 << int(math.log2(wanted)), _CHUNK_ROWS, few), 1 << math.ceil(math.log2(full)))


def rounds(campaign: CampaignFile) -> tuple[int, ...]:
    """Rows of a cell at the end of each round, rising: one round, or more until a wanted precision is reached.

    With a precision each round has whole chunks and blocks, so that what is done does not depend on where it stops;
    the last one ends at the most rows that are wanted, or less than a chunk or block before.
    """
    wanted = campaign.table.precision
    if wanted is None:
        return (campaign.rows,)
    unit = max(largest_chunk(campaign), campaign.block)  # powers of two, so the larger holds whole ones of the other
    totals, most = [_whole(campaign.rows, unit)], wanted.at_most // unit * unit
    while totals[-1] < most:
        totals.append(min(_whole(math.ceil(_GROWTH * totals[-1]), unit), most))
    return tuple(totals)


def _whole(rows: int, unit: int) -> int:
    return -(-rows // unit) * unit


def chunks(campaign: CampaignFile, cell: int, rows: int) -> list[Job]:
    """The chunks that the first ``rows`` rows of a cell are in."""
    return [Job(cell, number) for number in range(-(-rows // chunk_rows(campaign)))]


def rows_of(campaign: CampaignFile, number: int) -> range:
    """The rows of a chunk; the last one of a campaign may be shorter."""
    size = chunk_rows(campaign)
    return range(number * size, min((number + 1) * size, rounds(campaign)[-1]))
