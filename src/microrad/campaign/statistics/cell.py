"""What the rows of one cell say together."""

import math
from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from microrad.campaign.definition.outputs import OUTPUTS, RADIUS
from microrad.campaign.definition.records import CampaignFile
from microrad.campaign.records import CellSummary, Chunk, Interval, Limit, Tail, joined
from microrad.campaign.statistics import tails
from microrad.campaign.statistics.intervals import moments, ordered, output_summary, quantile_interval, share_interval
from microrad.core.arrays import Floats
from microrad.core.units import format_quantity, plain
from microrad.loop.pointing_loop.ensemble import bin_edges_rad

CONFIDENCE = 0.95
"""Of every interval, but for those that the campaign file asks for."""
QUANTILES = (0.001, 0.003, 0.01, 0.05, 0.5, 0.95, 0.99, 0.997, 0.999)
TAIL_CONFIDENCE = 0.99
TAIL_SHARES = (0.1, 0.01, 0.003, 1e-3, 1e-4, 1e-5, 1e-6)
_GIVEN = 15  # digits of a share as the file has it


class CellRows:
    """The rows of a cell as far as they were read, all of their columns: 8 bytes for each value.

    Of the curves of a chunk, which are as long as a thousand rows of two columns, there is the sum over all chunks.
    """

    def __init__(self, campaign: CampaignFile, number: int, chunks: Iterable[Chunk] = ()) -> None:
        """With these chunks of it.

        Args:
            campaign: the campaign.
            number: which cell.
            chunks: its chunks.
        """
        self.campaign, self.cell = campaign, campaign.cells[number]
        self.chunks: list[Chunk] = []
        """Those taken since the rows were last asked for, and all before them as one; without their curves."""
        self._survival, self._survival_square = np.zeros(0), np.zeros(0)
        for chunk in chunks:
            self.take(chunk)

    def take(self, chunk: Chunk) -> None:
        """Add a chunk. Any order gives the same rows; the last bits of the tail are those of this order."""
        if not self._survival.size:
            self._survival, self._survival_square = np.zeros((2, chunk.survival.size))
        if chunk.survival.size:  # there is none of a chunk whose rows were all lost
            self._survival = self._survival + chunk.survival
            self._survival_square = self._survival_square + chunk.survival_square
        self.chunks.append(replace(chunk, survival=np.zeros(0), survival_square=np.zeros(0)))

    @property
    def rows(self) -> int:
        """Rows that were read."""
        return sum(chunk.columns["row"].size for chunk in self.chunks)

    @property
    def failed(self) -> int:
        """Rows without a result."""
        return sum(len(chunk.failed) for chunk in self.chunks)

    @property
    def worth(self) -> float:
        """Rows of equal weight that would know a mean as well (Kish, Survey Sampling, 1965)."""
        whole = self.whole()
        if whole is None:
            return 0.0
        weights = moments(whole.columns[self.campaign.outputs[0].name], whole.columns["weight"])
        return weights.weight**2 / weights.weight_square if weights.count else 0.0

    def whole(self) -> Chunk | None:
        """All rows in their order as one chunk; None without any."""
        if not self.chunks:
            return None
        if len(self.chunks) > 1:
            self.chunks = [_in_order(joined(sorted(self.chunks, key=lambda chunk: chunk.number)))]
        return replace(self.chunks[0], survival=self._survival, survival_square=self._survival_square)

    def summary(self, quantiles: tuple[float, ...] = QUANTILES) -> CellSummary:
        """The cell as far as it was read; without ``quantiles``, how its rows keep the limits alone."""
        whole, table = self.whole(), self.campaign.table
        columns = {} if whole is None else whole.columns
        shown = self.campaign.outputs if columns and quantiles and table.tail is None else ()
        block = self.campaign.block if table.sampling != "random" else 0
        missed = {limit.output: _missed(limit, columns[limit.output]) for limit in self.campaign.limits if columns}
        weight = columns.get("weight", np.zeros(0))
        any_missed = np.max(list(missed.values()), axis=0) if missed else np.zeros(weight.size)
        return CellSummary(
            values=dict(self.cell.values),
            rows=self.rows,
            failed=self.failed,
            outputs={each.name: output_summary(each, columns, quantiles, CONFIDENCE, block) for each in shown},
            missed=share_interval(moments(any_missed, weight), CONFIDENCE),
            missed_by={name: share_interval(moments(bad, weight), CONFIDENCE) for name, bad in missed.items()},
            tail=self._tail(whole) if whole is not None and quantiles else None,
        )

    def _tail(self, whole: Chunk) -> Tail | None:
        wanted = self.campaign.table.tail
        if self.campaign.table.loop is None or self.rows == self.failed:
            return None
        if wanted is None:
            return self._tail_of_time(whole, TAIL_SHARES, TAIL_CONFIDENCE)
        radius, log_weight = whole.columns["tail_radius"], whole.columns["tail_log_weight"]
        known, errors = np.isfinite(radius), (wanted.error_rad,)
        return tails.tail_weighted(radius[known], log_weight[known], (wanted.probability,), TAIL_CONFIDENCE, errors)

    def _tail_of_time(self, whole: Chunk, shares: tuple[float, ...], confidence: float) -> Tail:
        sums, good = (whole.survival, whole.survival_square), self.rows - self.failed
        return tails.tail_of_time(*sums, good, bin_edges_rad(), shares, confidence)

    # ------------------------------------------------------------------------------------------------------ precision
    def is_precise(self) -> bool:
        """Whether the quantile that the campaign asks for is known as precisely as it asks; not without rows."""
        found = self._precision()
        return found is not None and self._is_enough(found)

    def _is_enough(self, found: Interval) -> bool:
        return (found.high - found.low) / 2.0 <= self.campaign.half_width  # nan is not narrow

    def _precision(self) -> Interval | None:
        """The quantile that the campaign asks for, as well as it is known; None where no row has a result."""
        wanted, whole = self.campaign.table.precision, self.whole()
        if wanted is None or whole is None or self.rows == self.failed:
            return None
        if wanted.output == RADIUS:
            beyond = 1.0 - wanted.quantile
            return self._tail_of_time(whole, (beyond,), wanted.confidence).wanted[beyond]
        in_order = ordered(whole.columns[wanted.output], whole.columns["weight"])
        return quantile_interval(in_order, wanted.quantile, wanted.confidence)

    def precision_words(self) -> str:
        """How well that quantile is known, and whether that is enough; "" where none is asked for."""
        wanted, found = self.campaign.table.precision, self._precision()
        if wanted is None or found is None:
            return ""
        unit = "rad" if wanted.output == RADIUS else OUTPUTS[wanted.output].unit
        value, low, high, half = (
            "unknown" if math.isnan(x) else format_quantity(x, unit).rstrip()
            for x in (found.value, found.low, found.high, self.campaign.half_width)
        )
        where = "".join(f" with {key} = {text}" for key, text in self.cell.values.items())
        enough = "as precise" if self._is_enough(found) else "NOT as precise"
        quantile, confidence = (f"{plain(100.0 * x, _GIVEN)} %" for x in (wanted.quantile, wanted.confidence))
        return (
            f"{quantile} quantile of {wanted.output}{where}: {value}, {low} to {high} at {confidence} confidence; "
            f"{enough} as asked for (± {half})."
        )


def _in_order(chunk: Chunk) -> Chunk:
    """The chunk with its rows in their order."""
    rows = chunk.columns["row"]
    if np.all(rows[1:] > rows[:-1]):
        return chunk
    order = np.argsort(rows, kind="stable")
    columns = {name: column[order] for name, column in chunk.columns.items()}
    return replace(chunk, columns=columns, failed=tuple(sorted(chunk.failed, key=lambda each: each.row)))


def _missed(limit: Limit, values: Floats) -> Floats:
    """1 where a value misses the limit, 0 where it keeps it; nan where it is not known."""
    bad = np.zeros(values.shape)
    if limit.least is not None:
        bad = np.maximum(bad, values < limit.least)
    if limit.most is not None:
        bad = np.maximum(bad, values > limit.most)
    return np.where(np.isnan(values), math.nan, bad)
