"""What the rows of a ledger say together, read chunk by chunk and always in their order: the same each time."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import groupby
from pathlib import Path

import numpy as np

from microrad.campaign import bundle
from microrad.campaign.definition.records import CampaignFile
from microrad.campaign.definition.tables import LoopTable
from microrad.campaign.ledger import Head, Ledger, is_written
from microrad.campaign.records import (
    CampaignSummary,
    CellSummary,
    Chunk,
    Job,
    Limit,
    Progress,
    Sensitivity,
    WorstTrace,
    joined,
)
from microrad.campaign.rows.plan import Plan, planned
from microrad.campaign.statistics.cell import MOST_FAILED, CellFold
from microrad.campaign.statistics.sensitivity import sensitivity
from microrad.core.arrays import Floats
from microrad.mirror import Variant

SAMPLE_ROWS = 4000
"""Rows of all cells that are kept for scatter plots."""
SENSITIVITY_ROWS = 20_000


def summarise_campaign(path: Path) -> CampaignSummary:
    """Everything that a status, a page or a picture shows of the campaign in a ledger, finished or not."""
    with Ledger.open(path, write=False) as book, book.still():
        head, notes = book.head, book.notes()
        campaign = bundle.opened(head.bundle, any_code=True).campaign
        plan = planned(campaign)
        sample = _Sample(book, plan)
        folds = [_folded(campaign, plan, number, sample.passing(number)) for number in range(len(campaign.cells))]
        first_round = plan.rounds[0] * len(campaign.cells)
        pace = progress(sum(fold.rows for fold in folds), first_round, notes, is_written(path))
        return replace(
            assembled(head, campaign, folds, [fold.summary() for fold in folds], pace),
            sensitivities=_sensitivities(campaign, plan, book),
            sample=sample.columns(),
            worst=_worst_first(campaign.limits, book.traces()),
        )


def is_precise(campaign: CampaignFile, book: Ledger, cell: int, rows: int) -> bool:
    """Whether the first rows of a cell know the wanted quantile as precisely as the campaign asks.

    Args:
        campaign: one that has a precision.
        book: its ledger.
        cell: number of the cell.
        rows: how many rows are looked at, whole chunks.
    """
    plan = planned(campaign)
    last = len(plan.chunks(cell, rows))
    return _folded(campaign, plan, cell, (each for each in book.chunks(cell) if each.number < last)).is_precise()


def assembled(
    head: Head, campaign: CampaignFile, folds: Sequence[CellFold], cells: Sequence[CellSummary], pace: Progress
) -> CampaignSummary:
    """A summary without what needs single rows: sensitivities, a sample and the worst traces."""
    failed = [(number, each) for number, fold in enumerate(folds) for each in fold.failed]
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
        cells=tuple(cells),
        sensitivities=(),
        sample={},
        worst=(),
        failed=tuple(failed[:MOST_FAILED]),
        progress=pace,
        warnings=_warnings(campaign, folds),
        findings=tuple(words for fold in folds if (words := fold.precision_words())),
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


# --------------------------------------------------------------------------------------------------------------- chunks
def _folded(campaign: CampaignFile, plan: Plan, number: int, chunks: Iterator[Chunk]) -> CellFold:
    """A cell with these chunks of it."""
    fold = CellFold(campaign, number)
    for chunk in _together(plan, chunks):
        fold.take(chunk)
    return fold


def _together(plan: Plan, chunks: Iterator[Chunk]) -> Iterator[Chunk]:
    """Neighbouring chunks as one each, so that no last digit depends on the size that chunks have by the clock."""
    several = plan.largest_chunk // plan.chunk_rows
    neighbours = groupby(enumerate(chunks), lambda at: (at[1].number - at[0], at[1].number // several))
    for _, group in neighbours:
        parts = [chunk for _, chunk in group]
        yield joined(Job(parts[0].cell, parts[0].number), parts) if len(parts) > 1 else parts[0]


class _Sample:
    """Rows of all cells, spread evenly, gathered while the chunks pass."""

    def __init__(self, book: Ledger, plan: Plan) -> None:
        rows = sum(len(plan.rows_of(number)) for _, number in book.done())
        self.every = max(math.ceil(rows / SAMPLE_ROWS), 1)
        self.book = book
        self.parts: list[dict[str, Floats]] = []

    def passing(self, cell: int) -> Iterator[Chunk]:
        """The chunks of a cell."""
        for chunk in self.book.chunks(cell):
            here = chunk.columns["row"] % self.every == 0
            part = {name: column[here] for name, column in chunk.columns.items()}
            self.parts.append({"cell": np.full(int(here.sum()), float(cell)), **part})
            yield chunk

    def columns(self) -> dict[str, Floats]:
        """The rows by column."""
        return _by_column(self.parts)


def _by_column(parts: Sequence[Mapping[str, Floats]]) -> dict[str, Floats]:
    """Parts of the same columns one behind the other."""
    return {name: np.concatenate([part[name] for part in parts]) for name in (parts[0] if parts else ())}


def _sensitivities(campaign: CampaignFile, plan: Plan, book: Ledger) -> tuple[Sensitivity, ...]:
    """How the inputs act on the limited outputs, from the rows of the first cell."""
    drawn = [each.key for each in campaign.inputs]
    names = list(dict.fromkeys(limit.output for limit in campaign.limits))
    if not drawn or not names:
        return ()
    parts: list[dict[str, Floats]] = []
    rows = 0
    for chunk in _together(plan, book.chunks(0)):
        parts.append({name: chunk.columns[name] for name in ("weight", *drawn, *names)})
        rows += chunk.columns["row"].size
        if rows >= SENSITIVITY_ROWS:
            break
    columns = _by_column(parts)
    if not parts or np.any(columns["weight"] != 1.0):
        return ()  # weighted rows are not drawn as the inputs are distributed
    return tuple(sensitivity({name: columns[name] for name in drawn}, columns[name], name) for name in names)


def _worst_first(limits: Sequence[Limit], traces: Sequence[WorstTrace]) -> tuple[WorstTrace, ...]:
    sign = -1.0 if limits and limits[0].most is not None else 1.0
    return tuple(sorted(traces, key=lambda trace: (trace.cell, sign * trace.value, trace.row)))


# ---------------------------------------------------------------------------------------------------------------- words
_EXTRAPOLATED = {
    "beyond_rate_share": "In some rows the mirror moves faster than the records that its model was identified from.",
    "outside_share": "In some rows the drive leaves the range that the mirror's model was identified in.",
}


def _warnings(campaign: CampaignFile, folds: Sequence[CellFold]) -> tuple[str, ...]:
    found = list(campaign.warnings)
    failed, rows = sum(fold.failed_rows for fold in folds), sum(fold.rows for fold in folds)
    if failed:
        found.append(f"{failed} of {rows} rows have no result; the figures are those of the others.")
    for name, words in _EXTRAPOLATED.items():
        if any(name in fold.outputs and fold.outputs[name].moments.most > 0.0 for fold in folds):
            found.append(words)
    if any(draw.drawn_as is not None for draw in campaign.draws):
        worth = min((fold.worth for fold in folds if fold.good), default=math.nan)
        found.append(
            "Some inputs are drawn from another distribution than their own and weighted back: for a mean the rows are "
            f"worth {worth:.3g} equal ones."
        )
    return tuple(found)


def _loop_words(table: LoopTable, runs: int) -> str:
    axes = "one axis" if table.axes == "one" else "both axes"
    mirror = "" if table.mirror is Variant.GIVEN else f", mirror: {table.mirror}"
    return f"{table.controller}, {axes}{mirror}, {runs} run{'s'[: runs > 1]} a row"
