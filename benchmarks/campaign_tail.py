"""Importance sampling of the loop's noise against plain runs: how many of each give the same interval at 1e-6.

    python benchmarks/campaign_tail.py            # some minutes
    python benchmarks/campaign_tail.py --quick    # projected alone, without the long plain ensemble

Both axes of the shipped mission under PI, runs of 0.4 s of which 0.35 s count: on the mirror without hysteresis, where
the answer is known, and on the comparison set. Tilted runs tell of one error each, plain runs of all their samples.
The plain runs needed are projected from the interval that few of them give at 1e-4, by a hundredth of the excursions
at 1e-6 and by the slope of a Rayleigh tail: its logarithm falls with the square of the radius. Then plain runs are made
until the interval of the radius is as narrow as that of the weighted ones.
"""

import math
import sys
import tempfile
import time
from functools import partial
from pathlib import Path

import numpy as np

from microrad.campaign.definition.records import CampaignFile
from microrad.campaign.file import load_campaign
from microrad.campaign.records import Chunk, Interval, Tail
from microrad.campaign.rows.evaluator import Evaluator
from microrad.campaign.rows.loops import mission_loop
from microrad.campaign.statistics.tails import tail_of_time, tail_weighted
from microrad.core.threads import in_threads
from microrad.loop.control import AxisController
from microrad.loop.fine_loop.ensemble import bin_edges_rad

MISSION = Path(__file__).resolve().parent.parent / "missions" / "leo-geo.toml"
PROBABILITY, CONFIDENCE = 1e-6, 0.99
SEEN = 1e-4
WEIGHTED, PART, MOST = 256, 2048, 400_000  # runs: weighted, plain ones of a part and at most
TEXT = """
mission = "mission.toml"
seed = 1
runs = {runs}
sampling = "random"
{more}
[loop]
controller = "PI"
axes = "both"
mirror = "{mirror}"
duration = "0.4 s"
settle = "0.05 s"

[set]
"fine_pointing.reference.point_ahead_on_mirror" = false
"fine_pointing.reference.rate_feedforward" = 1
"""
TAIL = '[tail]\nerror = "{error_urad:.6f} urad"\nprobability = {probability}\n'
KEEP = 'keep = ["residual_rms"]'


class Bench:
    """Runs of one mirror."""

    def __init__(self, folder: str, mirror: str) -> None:
        """The controller is tuned once."""
        self.folder, self.mirror = Path(folder), mirror
        (self.folder / "mission.toml").write_text(MISSION.read_text(encoding="utf-8"), encoding="utf-8")
        self.plain = self._campaign(MOST, KEEP)
        table = self.plain.table.loop
        assert table is not None
        self.axis: AxisController = mission_loop(self.plain.mission, table, 1).tuned()
        self.survival, self.square, self.runs = np.zeros(0), np.zeros(0), 0

    def _campaign(self, runs: int, more: str, tail: str = "") -> CampaignFile:
        path = self.folder / "campaign.toml"
        path.write_text(TEXT.format(runs=runs, more=more, mirror=self.mirror) + tail, encoding="utf-8")
        return load_campaign(path)

    def _rows(self, campaign: CampaignFile, rows: range) -> Chunk:
        return Evaluator(campaign, {0: self.axis}).rows(0, rows, lambda: None)

    def weighted(self, error_rad: float) -> Tail:
        """The tail from runs aimed at an error."""
        of = self._campaign(WEIGHTED, "", TAIL.format(error_urad=error_rad * 1e6, probability=PROBABILITY))
        columns = self._rows(of, range(WEIGHTED)).columns
        return tail_weighted(columns["tail_radius"], columns["tail_log_weight"], (PROBABILITY,), CONFIDENCE)

    def more(self) -> None:
        """Two more parts of plain runs."""
        begins = (self.runs, self.runs + PART)
        for chunk in in_threads([partial(self._rows, self.plain, range(b, b + PART)) for b in begins]):
            self.survival = chunk.survival + (self.survival if self.runs else 0.0)
            self.square = chunk.survival_square + (self.square if self.runs else 0.0)
            self.runs += PART

    def tail(self, probability: float) -> Tail:
        """The tail from the plain runs so far."""
        edges = bin_edges_rad()
        return tail_of_time(self.survival, self.square, self.runs, edges, (probability,), CONFIDENCE)


def width(radius: Interval) -> float:
    """Of the interval, in parts of the radius; infinite where an end is not known."""
    return math.inf if math.isnan(radius.high - radius.low) else (radius.high - radius.low) / radius.value


def projected(runs: int, visible: Interval, wanted: Interval) -> float:
    """Plain runs that know the wanted radius to its interval, where so many know the visible one to its."""
    slopes = math.log(SEEN) / math.log(PROBABILITY)  # of what a part of the radius is in the probability's logarithm
    return runs * SEEN / PROBABILITY * (slopes * width(visible) / width(wanted)) ** 2


def said(runs: int, what: str, radius: Interval, seconds: float) -> None:
    """One line of results."""
    ends = f"{radius.low * 1e6:.3f} to {radius.high * 1e6:.3f} urad"
    print(f"  {runs:7d} {what} runs: {radius.value * 1e6:.3f} urad ({ends}), {seconds:.1f} s", flush=True)


def compared(mirror: str, quick: bool) -> None:
    """Both ways on one mirror."""
    with tempfile.TemporaryDirectory() as folder:
        bench = Bench(folder, mirror)
        began = time.perf_counter()
        bench.more()
        visible = bench.tail(SEEN)
        error = visible.wanted[SEEN].value * math.sqrt(math.log(PROBABILITY) / math.log(SEEN))
        print(f'mirror "{mirror}": radius exceeded with probability {PROBABILITY:g}, at {100 * CONFIDENCE:g} %')
        plain_s, began = time.perf_counter() - began, time.perf_counter()
        tail = bench.weighted(error)
        found = tail.wanted[PROBABILITY]
        said(WEIGHTED, "weighted", found, time.perf_counter() - began)
        need = projected(bench.runs, visible.wanted[SEEN], found)
        print(f"    projected: {need:.0f} plain runs, {need / WEIGHTED:.0f} x as many")
        if quick:
            return
        began, told = time.perf_counter(), 20 * WEIGHTED
        while width(bench.tail(PROBABILITY).wanted[PROBABILITY]) > width(found) and bench.runs < MOST - 2 * PART:
            bench.more()
            if bench.runs >= told:
                said(
                    bench.runs,
                    "plain",
                    bench.tail(PROBABILITY).wanted[PROBABILITY],
                    plain_s + time.perf_counter() - began,
                )
                told = 4 * bench.runs
        seconds = plain_s + time.perf_counter() - began
        said(bench.runs, "plain", bench.tail(PROBABILITY).wanted[PROBABILITY], seconds)
        narrow = width(bench.tail(PROBABILITY).wanted[PROBABILITY]) <= width(found)
        print(f"    measured: {'' if narrow else 'more than '}{bench.runs / WEIGHTED:.0f} x as many plain runs\n")


if __name__ == "__main__":
    for each in ("no hysteresis", "comparison"):
        compared(each, "--quick" in sys.argv)
