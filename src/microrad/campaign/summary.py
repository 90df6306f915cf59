"""What the rows of a ledger say together, read chunk by chunk and always in their order: the same each time."""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from itertools import groupby
from pathlib import Path

import numpy as np

from microrad.campaign import bundle, plan, statistics, tails
from microrad.campaign.blob import Head
from microrad.campaign.definition import CampaignFile
from microrad.campaign.ledger import Ledger
from microrad.campaign.ledger_file import is_written
from microrad.campaign.outputs import OUTPUTS, RADIUS
from microrad.campaign.records import (
    CampaignSummary,
    CellSummary,
    Chunk,
    Failed,
    Interval,
    Job,
    Limit,
    OutputSummary,
    Progress,
    Sensitivity,
    Tail,
    WorstTrace,
    joined,
)
from microrad.campaign.statistics import Fold, Moments
from microrad.core import kernels
from microrad.core.arrays import Floats
from microrad.core.units import format_quantity
from microrad.loop.pointing_loop.ensemble import bin_edges_rad

CONFIDENCE = 0.95
"""Of every interval, but for those that the campaign file asks for."""
QUANTILES = (0.001, 0.003, 0.01, 0.05, 0.5, 0.95, 0.99, 0.997, 0.999)
SAMPLE_ROWS = 4000
"""Rows of all cells that are kept for scatter plots."""
SENSITIVITY_ROWS = 20_000
TAIL_SHARES = (0.1, 0.01, 0.003, 1e-3, 1e-4, 1e-5, 1e-6)
MOST_FAILED = 1000
"""Failed rows that are listed."""


@dataclass
class Folded:
    """A cell as far as it has been read; see `begun` and `take`."""

    outputs: dict[str, Fold]
    missed: Moments = field(default_factory=Moments)
    missed_by: dict[str, Moments] = field(default_factory=dict)
    rows: int = 0
    good: int = 0
    failed: list[Failed] = field(default_factory=list)
    failed_rows: int = 0
    survival: Floats = field(default_factory=lambda: np.zeros(kernels.BINS))
    survival_square: Floats = field(default_factory=lambda: np.zeros(kernels.BINS))
    tilted: list[tuple[Floats, Floats]] = field(default_factory=list)

    @property
    def worth(self) -> float:
        """Rows of equal weight that would know a mean as well (Kish, Survey Sampling, 1965)."""
        weights = next(iter(self.outputs.values())).moments
        return weights.weight**2 / weights.weight_square if weights.count else 0.0


def missed(limit: Limit, values: Floats) -> Floats:
    """1 where a value misses the limit, 0 where it keeps it; nan where it is not known."""
    bad = np.zeros(values.shape)
    if limit.least is not None:
        bad = np.maximum(bad, values < limit.least)
    if limit.most is not None:
        bad = np.maximum(bad, values > limit.most)
    return np.where(np.isnan(values), math.nan, bad)


def begun(campaign: CampaignFile) -> Folded:
    """A cell that nothing was read of yet."""
    block = campaign.block if campaign.table.sampling != "random" else 0
    return Folded({output.name: Fold(block) for output in plan.outputs(campaign)})


def take(campaign: CampaignFile, cell: Folded, chunk: Chunk) -> None:
    """Take a chunk in. All but the intervals of means is the same in any order of the chunks, to rounding."""
    weight = chunk.columns["weight"]
    cell.rows += weight.size
    cell.failed_rows += len(chunk.failed)
    cell.good += weight.size - len(chunk.failed)
    cell.failed += chunk.failed[: MOST_FAILED - len(cell.failed)]
    for name, fold in cell.outputs.items():
        fold.add(int(chunk.columns["row"][0]), chunk.columns[name], weight)
    every = np.zeros(weight.size)
    for limit in campaign.limits:
        bad = missed(limit, chunk.columns[limit.output])
        every = np.maximum(every, bad)
        before = cell.missed_by.get(limit.output, Moments())
        cell.missed_by[limit.output] = before.merged(statistics.moments(bad, weight))
    cell.missed = cell.missed.merged(statistics.moments(every, weight))
    if chunk.survival.size:
        cell.survival += chunk.survival
        cell.survival_square += chunk.survival_square
    if campaign.table.tail is not None:
        cell.tilted.append((chunk.columns["tail_radius"], chunk.columns["tail_log_weight"]))


def _read(campaign: CampaignFile, chunks: Iterator[Chunk]) -> Folded:
    cell = begun(campaign)
    for chunk in _together(campaign, chunks):
        take(campaign, cell, chunk)
    return cell


def _together(campaign: CampaignFile, chunks: Iterator[Chunk]) -> Iterator[Chunk]:
    """Neighbouring chunks as one each, so that no last digit depends on the size that chunks have by the clock."""
    several = plan.largest_chunk(campaign) // plan.chunk_rows(campaign)
    neighbours = groupby(enumerate(chunks), lambda at: (at[1].number - at[0], at[1].number // several))
    for _, group in neighbours:
        parts = [chunk for _, chunk in group]
        yield joined(Job(parts[0].cell, parts[0].number), parts) if len(parts) > 1 else parts[0]


def _outputs(campaign: CampaignFile, cell: Folded, quantiles: tuple[float, ...]) -> dict[str, OutputSummary]:
    if campaign.table.tail is not None:  # its rows are draws for the tail alone
        return {}
    return {
        output.name: cell.outputs[output.name].summary(output.name, output.unit, output.meaning, quantiles, CONFIDENCE)
        for output in plan.outputs(campaign)
    }


def _tail(campaign: CampaignFile, cell: Folded) -> Tail | None:
    wanted = campaign.table.tail
    if wanted is not None and cell.good:
        radius, log_weight = (np.concatenate(part) for part in zip(*cell.tilted, strict=True))
        known = np.isfinite(radius)
        return tails.tail_weighted(radius[known], log_weight[known], (wanted.probability,), 0.99, (wanted.error_rad,))
    if campaign.table.loop is None or not cell.good:
        return None
    return tails.tail_of_time(cell.survival, cell.survival_square, cell.good, bin_edges_rad(), TAIL_SHARES, 0.99)


def reached(campaign: CampaignFile, book: Ledger, cell: int, rows: int) -> bool:
    """Whether the first ``rows`` rows of a cell know the wanted quantile as precisely as the campaign asks."""
    last = len(plan.chunks(campaign, cell, rows))
    read = _read(campaign, (chunk for chunk in book.chunks(cell) if chunk.number < last))
    interval = precision(campaign, read)
    return (interval.high - interval.low) / 2.0 <= campaign.half_width  # nan is not narrow


def precision(campaign: CampaignFile, read: Folded) -> Interval:
    """The quantile that the campaign wants to know, as well as it is known."""
    wanted = campaign.table.precision
    assert wanted is not None
    if wanted.output == RADIUS:
        return _time_tail(read, 1.0 - wanted.quantile, wanted.confidence)
    return statistics.quantile_interval(read.outputs[wanted.output].sketch, wanted.quantile, wanted.confidence)


def _time_tail(read: Folded, probability: float, confidence: float) -> Interval:
    tail = tails.tail_of_time(
        read.survival, read.survival_square, read.good, bin_edges_rad(), (probability,), confidence
    )
    return tail.wanted[probability]


def _precision_words(campaign: CampaignFile, read: Folded, values: Mapping[str, str]) -> list[str]:
    """How well the wanted quantile is known, and whether that is enough."""
    wanted = campaign.table.precision
    if wanted is None or not read.good:
        return []
    found = precision(campaign, read)
    unit = "rad" if wanted.output == RADIUS else OUTPUTS[wanted.output].unit
    value, low, high, half = (
        "unknown" if math.isnan(x) else format_quantity(x, unit, 4) if unit else f"{x:.4g}"
        for x in (found.value, found.low, found.high, campaign.half_width)
    )
    where = "".join(f" with {key} = {text}" for key, text in values.items())
    enough = (found.high - found.low) / 2.0 <= campaign.half_width
    said = f"as precise as asked for (± {half})" if enough else f"NOT as precise as asked for (± {half})"
    return [
        f"{100 * wanted.quantile:g} % quantile of {wanted.output}{where}: {value}, {low} to {high} at "
        f"{100 * wanted.confidence:g} % confidence; {said}."
    ]


def _worst_first(campaign: CampaignFile, traces: tuple[WorstTrace, ...]) -> tuple[WorstTrace, ...]:
    sign = -1.0 if campaign.limits and campaign.limits[0].most is not None else 1.0
    return tuple(sorted(traces, key=lambda trace: (trace.cell, sign * trace.value, trace.row)))


# -------------------------------------------------------------------------------------------------------------- summary
def summarise(path: Path) -> CampaignSummary:
    """Everything that a status, a page or a picture shows of the campaign in a ledger, finished or not."""
    with Ledger.open(path, write=False) as book, book.still():
        head, notes = book.head, book.notes()
        opened = bundle.opened(head.bundle, any_code=True)
        campaign, sample = opened.campaign, _Sample(opened.campaign, book)
        reads = [_read(campaign, sample.passing(number)) for number in range(len(campaign.cells))]
        cells = [cell_summary(campaign, number, read) for number, read in enumerate(reads)]
        pace = progress(campaign, sum(read.rows for read in reads), notes, is_written(path))
        return replace(
            assembled(head, campaign, cells, reads, pace),
            sensitivities=_sensitivities(campaign, book),
            sample=sample.columns(),
            worst=_worst_first(campaign, book.traces()),
        )


def cell_summary(
    campaign: CampaignFile, number: int, read: Folded, quantiles: tuple[float, ...] = QUANTILES
) -> CellSummary:
    """A cell as it was read; without ``quantiles``, how its rows keep the limits alone."""
    return CellSummary(
        values=dict(campaign.cells[number]),
        rows=read.rows,
        failed=read.failed_rows,
        outputs=_outputs(campaign, read, quantiles) if quantiles else {},
        missed=statistics.share_interval(read.missed, CONFIDENCE),
        missed_by={name: statistics.share_interval(share, CONFIDENCE) for name, share in read.missed_by.items()},
        tail=_tail(campaign, read) if quantiles else None,
    )


def assembled(
    head: Head, campaign: CampaignFile, cells: list[CellSummary], reads: list[Folded], pace: Progress
) -> CampaignSummary:
    """A summary without what needs single rows: sensitivities, a sample and the worst traces."""
    failed = [(number, each) for number, read in enumerate(reads) for each in read.failed]
    findings = (_precision_words(campaign, read, campaign.cells[number]) for number, read in enumerate(reads))
    return CampaignSummary(
        name=head.campaign_name,
        mission_name=head.mission_name,
        hashes=head.hashes,
        seed=head.seed,
        sampling=campaign.table.sampling,
        loop=_loop_words(campaign),
        inputs=campaign.inputs,
        fixed=campaign.fixed,
        limits=campaign.limits,
        cells=tuple(cells),
        sensitivities=(),
        sample={},
        worst=(),
        failed=tuple(failed[:MOST_FAILED]),
        progress=pace,
        warnings=_warnings(campaign, cells, reads),
        findings=tuple(words for found in findings for words in found),
    )


def _loop_words(campaign: CampaignFile) -> str:
    table = campaign.table.loop
    if table is None:
        return ""
    axes = "one axis" if table.axes == "one" else "both axes"
    mirror = "" if table.mirror == "given" else f", mirror: {table.mirror}"
    return f"{table.controller}, {axes}{mirror}, {campaign.realisations} run{'s'[: campaign.realisations > 1]} a row"


class _Sample:
    """Rows of all cells, spread evenly, gathered while the chunks pass."""

    def __init__(self, campaign: CampaignFile, book: Ledger) -> None:
        rows = sum(len(plan.rows_of(campaign, number)) for _, number in book.done())
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
        if not self.parts:
            return {}
        return {name: np.concatenate([part[name] for part in self.parts]) for name in self.parts[0]}


def _sensitivities(campaign: CampaignFile, book: Ledger) -> tuple[Sensitivity, ...]:
    """How the inputs act on the limited outputs, from the rows of the first cell."""
    from microrad.campaign.sensitivity import sensitivity  # loads scipy

    drawn = [name for name, _ in campaign.dimensions]
    names = list(dict.fromkeys(limit.output for limit in campaign.limits))
    if not drawn or not names:
        return ()
    parts: list[dict[str, Floats]] = []
    rows = 0
    for chunk in _together(campaign, book.chunks(0)):
        parts.append({name: chunk.columns[name] for name in ("weight", *drawn, *names)})
        rows += chunk.columns["row"].size
        if rows >= SENSITIVITY_ROWS:
            break
    if not parts:
        return ()
    columns = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
    if np.any(columns["weight"] != 1.0):
        return ()  # the rows are not drawn as the inputs are distributed
    return tuple(sensitivity({name: columns[name] for name in drawn}, columns[name], name) for name in names)


def progress(campaign: CampaignFile, done: int, notes: Mapping[str, object], written: bool) -> Progress:
    """How far a campaign is with so many rows, from what its ledger notes, and whether a process writes to that."""
    seconds, state = float(str(notes.get("seconds", 0.0))), str(notes.get("state", "waiting"))
    if state == "running" and not written:  # whoever ran it was killed
        state = "stopped"
    total = done if state == "complete" else max(done, plan.rounds(campaign)[0] * len(campaign.cells))
    rate = done / seconds if seconds > 0.0 else math.nan
    left = (total - done) / rate if rate > 0.0 else math.nan
    assert state in {"waiting", "running", "stopped", "complete"}
    return Progress(done, total, seconds, rate, left, state)  # type: ignore[arg-type]


_EXTRAPOLATED = {
    "beyond_rate_share": "In some rows the mirror moves faster than the records that its model was identified from.",
    "outside_share": "In some rows the drive leaves the range that the mirror's model was identified in.",
}


def _largest(cells: list[CellSummary], name: str) -> float:
    """Largest value of an output in any row, 0 where it is not kept."""
    return max((cell.outputs[name].most for cell in cells if name in cell.outputs), default=0.0)


def _warnings(campaign: CampaignFile, cells: list[CellSummary], reads: list[Folded]) -> tuple[str, ...]:
    found = list(campaign.warnings)
    failed, rows = sum(cell.failed for cell in cells), sum(cell.rows for cell in cells)
    if failed:
        found.append(f"{failed} of {rows} rows have no result; the figures are those of the others.")
    found += [words for name, words in _EXTRAPOLATED.items() if _largest(cells, name) > 0.0]
    if any(draw.drawn_as is not None for draw in campaign.draws):
        worth = min((cell.worth for cell in reads if cell.good), default=math.nan)
        found.append(
            "Some inputs are drawn from another distribution than their own and weighted back: for a mean the rows are "
            f"worth {worth:.3g} equal ones."
        )
    return tuple(found)
