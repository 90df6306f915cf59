"""What the rows of a ledger say together, always in their order: the same each time."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from microrad.campaign import bundle
from microrad.campaign.definition.records import CampaignFile
from microrad.campaign.definition.tables import LoopTable
from microrad.campaign.ledger import Head, Ledger, is_written
from microrad.campaign.records import CampaignSummary, CellSummary, Limit, Progress, Sensitivity, WorstTrace
from microrad.campaign.rows.plan import planned
from microrad.campaign.statistics.cell import CellRows
from microrad.campaign.statistics.sensitivity import sensitivity
from microrad.core.arrays import Floats
from microrad.core.units import plain
from microrad.mirror import Variant

SAMPLE_ROWS = 4000
"""Rows of all cells that are kept for scatter plots."""
MOST_FAILED = 1000
"""Failed rows that are listed."""


def summarise_campaign(path: Path) -> CampaignSummary:
    """Everything that a status, a page or a picture shows of the campaign in a ledger, finished or not."""
    with Ledger.open(path, write=False) as book, book.still():
        head, notes, traces = book.head, book.notes(), book.traces()
        campaign = bundle.opened(head.bundle, any_code=True).campaign
        cells = [CellRows(campaign, number, book.chunks(number)) for number in range(len(campaign.cells))]
    first_round = planned(campaign).rounds[0] * len(cells)
    pace = progress(sum(cell.rows for cell in cells), first_round, notes, is_written(path))
    return replace(
        assembled(head, campaign, cells, [cell.summary() for cell in cells], pace),
        sensitivities=_sensitivities(campaign, cells[0]),
        sample=_sample(cells),
        worst=_worst_first(campaign.limits, traces),
    )


def assembled(
    head: Head, campaign: CampaignFile, cells: Sequence[CellRows], summaries: Sequence[CellSummary], pace: Progress
) -> CampaignSummary:
    """A summary without what needs single rows: sensitivities, a sample and the worst traces.

    Args:
        head: that of the ledger.
        campaign: the campaign.
        cells: the rows of each cell.
        summaries: what they say, of each cell.
        pace: how far the campaign is.
    """
    failed = [(number, each) for number, cell in enumerate(cells) for chunk in cell.chunks for each in chunk.failed]
    return CampaignSummary(
        name=head.campaign_name,
        mission_name=head.mission_name,
        hashes=head.hashes,
        seed=head.seed,
        sampling=campaign.table.sampling,
        loop="" if campaign.table.loop is None else _loop_words(campaign.table.loop, campaign.realisations),
        inputs=campaign.inputs,
        fixed=campaign.fixed,
        limits=campaign.limits,
        cells=tuple(summaries),
        sensitivities=(),
        sample={},
        worst=(),
        failed=tuple(failed[:MOST_FAILED]),
        progress=pace,
        warnings=_warnings(campaign, cells),
        findings=tuple(words for cell in cells if (words := cell.precision_words())),
    )


def progress(done: int, first_round: int, notes: Mapping[str, object], written: bool) -> Progress:
    """How far a campaign is.

    Args:
        done: rows in its ledger.
        first_round: rows of its first round, in all cells.
        notes: what its ledger notes.
        written: whether a process writes to it.
    """
    seconds, state = float(str(notes.get("seconds", 0.0))), str(notes.get("state", "waiting"))
    if state == "running" and not written:  # whoever ran it was killed
        state = "stopped"
    total = done if state == "complete" else max(done, first_round)
    rate = done / seconds if seconds > 0.0 else math.nan
    left = (total - done) / rate if rate > 0.0 else math.nan
    assert state in {"waiting", "running", "stopped", "complete"}
    return Progress(done, total, seconds, rate, left, state)  # type: ignore[arg-type]


# ----------------------------------------------------------------------------------------------------------------- rows
def _sample(cells: Sequence[CellRows]) -> dict[str, Floats]:
    """Rows of all cells, spread evenly, by column."""
    every = max(math.ceil(sum(cell.rows for cell in cells) / SAMPLE_ROWS), 1)
    parts: list[dict[str, Floats]] = []
    for number, cell in enumerate(cells):
        if whole := cell.whole():
            here = whole.columns["row"] % every == 0
            picked = {name: column[here] for name, column in whole.columns.items()}
            parts.append({"cell": np.full(int(here.sum()), float(number)), **picked})
    return {name: np.concatenate([part[name] for part in parts]) for name in (parts[0] if parts else ())}


def _sensitivities(campaign: CampaignFile, cell: CellRows) -> tuple[Sensitivity, ...]:
    """How the inputs act on the limited outputs, from the rows of a cell."""
    drawn = [each.key for each in campaign.inputs]
    names = list(dict.fromkeys(limit.output for limit in campaign.limits))
    whole = cell.whole()
    if not drawn or not names or whole is None or np.any(whole.columns["weight"] != 1.0):
        return ()  # weighted rows are not drawn as the inputs are distributed
    inputs = {name: whole.columns[name] for name in drawn}
    return tuple(sensitivity(inputs, whole.columns[name], name) for name in names)


def _worst_first(limits: Sequence[Limit], traces: Sequence[WorstTrace]) -> tuple[WorstTrace, ...]:
    sign = -1.0 if limits and not limits[0].worst_is_least else 1.0
    return tuple(sorted(traces, key=lambda trace: (trace.cell, sign * trace.value, trace.row)))


# ---------------------------------------------------------------------------------------------------------------- words
_EXTRAPOLATED = {
    "beyond_rate_share": "In some rows the mirror moves faster than the records that its model was identified from.",
    "outside_share": "In some rows the drive leaves the range that the mirror's model was identified in.",
}


def _warnings(campaign: CampaignFile, cells: Sequence[CellRows]) -> tuple[str, ...]:
    found = list(campaign.warnings)
    failed, rows = sum(cell.failed for cell in cells), sum(cell.rows for cell in cells)
    if failed:
        some = f"{failed} of {rows} rows have no result; the figures are those of the others."
        found.append("No row has a result: there are no figures." if failed == rows else some)
    chunks = [chunk.columns for cell in cells for chunk in cell.chunks]
    for name, words in _EXTRAPOLATED.items():
        if any(np.any(columns[name] > 0.0) for columns in chunks if name in columns):
            found.append(words)
    known = [cell for cell in cells if cell.rows > cell.failed]
    if known and any(draw.drawn_as is not None for draw in campaign.draws):
        found.append(
            "Some inputs are drawn from another distribution than their own and weighted back: for a mean the rows are "
            f"worth {plain(min(cell.worth for cell in known))} equal ones."
        )
    return tuple(found)


def _loop_words(table: LoopTable, runs: int) -> str:
    axes = "one axis" if table.axes == "one" else "both axes"
    mirror = "" if table.mirror is Variant.GIVEN else f", mirror: {table.mirror}"
    return f"{table.controller}, {axes}{mirror}, {runs} run{'s'[: runs > 1]} a row"
