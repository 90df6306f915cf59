"""What the rows of one cell say together: folded chunk by chunk, in memory that does not grow with them."""

import math

import numpy as np

from microrad.campaign.definition.outputs import OUTPUTS, RADIUS
from microrad.campaign.definition.records import CampaignFile
from microrad.campaign.records import CellSummary, Chunk, Failed, Interval, Limit, Tail
from microrad.campaign.statistics import tails
from microrad.campaign.statistics.intervals import Fold, Moments, moments, quantile_interval, share_interval
from microrad.core import kernels
from microrad.core.arrays import Floats
from microrad.core.units import format_quantity
from microrad.loop.fine_loop.ensemble import bin_edges_rad

CONFIDENCE = 0.95
"""Of every interval, but for those that the campaign file asks for."""
QUANTILES = (0.001, 0.003, 0.01, 0.05, 0.5, 0.95, 0.99, 0.997, 0.999)
TAIL_CONFIDENCE = 0.99
TAIL_SHARES = (0.1, 0.01, 0.003, 1e-3, 1e-4, 1e-5, 1e-6)
MOST_FAILED = 1000
"""Failed rows that are listed."""


class CellFold:
    """A cell as far as its chunks have been taken in."""

    def __init__(self, campaign: CampaignFile, number: int) -> None:
        """No chunk yet."""
        block = campaign.block if campaign.table.sampling != "random" else 0
        self.campaign, self.cell = campaign, campaign.cells[number]
        self.outputs = {output.name: Fold(block) for output in campaign.outputs}
        self.missed = Moments()
        self.missed_by: dict[str, Moments] = {}
        self.rows = self.failed_rows = 0
        self.failed: list[Failed] = []
        self.survival, self.survival_square = np.zeros(kernels.BINS), np.zeros(kernels.BINS)
        self.weighted: list[tuple[Floats, Floats]] = []

    @property
    def good(self) -> int:
        """Rows with a result."""
        return self.rows - self.failed_rows

    @property
    def worth(self) -> float:
        """Rows of equal weight that would know a mean as well (Kish, Survey Sampling, 1965)."""
        weights = next(iter(self.outputs.values())).moments
        return weights.weight**2 / weights.weight_square if weights.count else 0.0

    def take(self, chunk: Chunk) -> None:
        """Take a chunk in. All but the intervals of means is the same in any order of the chunks, to rounding."""
        weight = chunk.columns["weight"]
        self.rows += weight.size
        self.failed_rows += len(chunk.failed)
        self.failed += chunk.failed[: MOST_FAILED - len(self.failed)]
        for name, fold in self.outputs.items():
            fold.add(int(chunk.columns["row"][0]), chunk.columns[name], weight)
        every = np.zeros(weight.size)
        for limit in self.campaign.limits:
            bad = _missed(limit, chunk.columns[limit.output])
            every = np.maximum(every, bad)
            before = self.missed_by.get(limit.output, Moments())
            self.missed_by[limit.output] = before.merged(moments(bad, weight))
        self.missed = self.missed.merged(moments(every, weight))
        if chunk.survival.size:
            self.survival += chunk.survival
            self.survival_square += chunk.survival_square
        if self.campaign.table.tail is not None:
            self.weighted.append((chunk.columns["tail_radius"], chunk.columns["tail_log_weight"]))

    def summary(self, quantiles: tuple[float, ...] = QUANTILES) -> CellSummary:
        """The cell as far as it was read; without ``quantiles``, how its rows keep the limits alone."""
        shown = self.campaign.outputs if quantiles and self.campaign.table.tail is None else ()
        return CellSummary(
            values=dict(self.cell.values),
            rows=self.rows,
            failed=self.failed_rows,
            outputs={each.name: self.outputs[each.name].summary(each, quantiles, CONFIDENCE) for each in shown},
            missed=share_interval(self.missed, CONFIDENCE),
            missed_by={name: share_interval(share, CONFIDENCE) for name, share in self.missed_by.items()},
            tail=self._tail() if quantiles else None,
        )

    def _tail(self) -> Tail | None:
        wanted = self.campaign.table.tail
        if self.campaign.table.loop is None or not self.good:
            return None
        if wanted is None:
            return self._tail_of_time(TAIL_SHARES, TAIL_CONFIDENCE)
        radius, log_weight = (np.concatenate(part) for part in zip(*self.weighted, strict=True))
        known, errors = np.isfinite(radius), (wanted.error_rad,)
        return tails.tail_weighted(radius[known], log_weight[known], (wanted.probability,), TAIL_CONFIDENCE, errors)

    def _tail_of_time(self, shares: tuple[float, ...], confidence: float) -> Tail:
        sums = self.survival, self.survival_square
        return tails.tail_of_time(*sums, self.good, bin_edges_rad(), shares, confidence)

    # ------------------------------------------------------------------------------------------------------ precision
    def is_precise(self) -> bool:
        """Whether the quantile that the campaign asks for is known as precisely as it asks."""
        found = self._precision()
        return (found.high - found.low) / 2.0 <= self.campaign.half_width  # nan is not narrow

    def _precision(self) -> Interval:
        """The quantile that the campaign asks for, as well as it is known."""
        wanted = self.campaign.table.precision
        assert wanted is not None
        if wanted.output == RADIUS:
            beyond = 1.0 - wanted.quantile
            return self._tail_of_time((beyond,), wanted.confidence).wanted[beyond]
        return quantile_interval(self.outputs[wanted.output].sketch, wanted.quantile, wanted.confidence)

    def precision_words(self) -> str:
        """How well that quantile is known, and whether that is enough; "" where none is asked for."""
        wanted = self.campaign.table.precision
        if wanted is None or not self.good:
            return ""
        found = self._precision()
        unit = "rad" if wanted.output == RADIUS else OUTPUTS[wanted.output].unit
        value, low, high, half = (
            "unknown" if math.isnan(x) else format_quantity(x, unit, 4) if unit else f"{x:.4g}"
            for x in (found.value, found.low, found.high, self.campaign.half_width)
        )
        where = "".join(f" with {key} = {text}" for key, text in self.cell.values.items())
        enough = "as precise" if self.is_precise() else "NOT as precise"
        return (
            f"{100 * wanted.quantile:g} % quantile of {wanted.output}{where}: {value}, {low} to {high} at "
            f"{100 * wanted.confidence:g} % confidence; {enough} as asked for (± {half})."
        )


def _missed(limit: Limit, values: Floats) -> Floats:
    """1 where a value misses the limit, 0 where it keeps it; nan where it is not known."""
    bad = np.zeros(values.shape)
    if limit.least is not None:
        bad = np.maximum(bad, values < limit.least)
    if limit.most is not None:
        bad = np.maximum(bad, values > limit.most)
    return np.where(np.isnan(values), math.nan, bad)
