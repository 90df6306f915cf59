"""From the numbers of rows to their outputs: drawn, simulated together where they share a loop, and evaluated."""

import math
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from itertools import groupby

import numpy as np

from microrad.campaign.definition.records import CampaignFile
from microrad.campaign.records import CampaignError, Chunk, Failed, WorstTrace
from microrad.campaign.rows import evaluate, importance_sampling, sampling
from microrad.campaign.rows.loops import MissionLoop, mission_loop
from microrad.campaign.rows.missions import MissionBuilder
from microrad.core import kernels
from microrad.core.arrays import Floats
from microrad.loop.control import AxisController
from microrad.loop.pointing_loop import ensemble, traces
from microrad.loop.pointing_loop.loop import LoopController
from microrad.mirror.coupled import CoupledMirror
from microrad.mission.file import LinkFile

Beat = Callable[[], None]

ATTEMPTS = 2
"""Times that a row is tried, the second time by itself, before it has failed."""


class SlowRowError(Exception):
    """A row has taken longer than the campaign allows."""


@dataclass
class _Watch:
    """Passes signs of life on and ends a row that takes too long."""

    beat: Beat
    limit_s: float
    began_s: float = field(default_factory=time.monotonic)

    def start(self) -> None:
        """A new row, or batch of rows."""
        self.began_s = time.monotonic()
        self.beat()

    def __call__(self) -> None:
        self.beat()
        if time.monotonic() - self.began_s > self.limit_s:
            raise SlowRowError(f"took longer than row_limit, {self.limit_s:g} s")


@dataclass(frozen=True, slots=True)
class _Rows:
    """Drawn rows of a cell: the inputs' columns, weights, and a mission or the reason why there is none.

    ``mirrors`` are the drawn ones of several axes, None where none is drawn.
    """

    cell: int
    first: int
    columns: dict[str, Floats]
    weight: Floats
    files: list[LinkFile | str]
    mirrors: list[CoupledMirror | None]
    keys: list[object]


@dataclass(frozen=True, slots=True)
class Simulated:
    """The runs of consecutive rows that share a loop, from ``first_row`` on, ``realisations`` for each."""

    first_row: int
    realisations: int
    runs: ensemble.Ensemble

    def row(self, row: int) -> ensemble.Ensemble:
        """The runs of one row."""
        return self.runs.part((row - self.first_row) * self.realisations, self.realisations)


@dataclass(frozen=True, slots=True)
class _Weighted:
    """The errors (rad) that consecutive rows end in, one run each, and the logarithms of their weights."""

    first_row: int
    radius_rad: Floats
    log_weight: Floats

    def row(self, row: int) -> dict[str, float]:
        """The two outputs of a row."""
        at = row - self.first_row
        return {"tail_radius": float(self.radius_rad[at]), "tail_log_weight": float(self.log_weight[at])}


class Evaluator:
    """Evaluates rows of a campaign; its methods may be called from several threads.

    Args:
        campaign: what is drawn and kept.
        controllers: the tuned controller of each cell by its number; none without a loop.
        fixed: values of mission keys that all rows have, in SI units.
        memory: where the runs of rows are kept whose loop is the same in later calls; None: they are not.
    """

    def __init__(
        self,
        campaign: CampaignFile,
        controllers: Mapping[int, AxisController],
        fixed: Mapping[str, float] | None = None,
        memory: dict[object, Simulated] | None = None,
    ) -> None:
        """Nothing is computed yet."""
        self.campaign, self.controllers, self.fixed, self.memory = campaign, controllers, dict(fixed or {}), memory
        self.builder = MissionBuilder(campaign)
        self.names = tuple(output.name for output in campaign.outputs)
        self._cell_controllers: dict[int, LoopController] = {}
        self._proposals: dict[int, importance_sampling.Proposal] = {}

    # ----------------------------------------------------------------------------------------------------------- rows
    def rows(self, cell: int, rows: range, beat: Beat, attempts: int = ATTEMPTS, number: int = 0) -> Chunk:
        """Rows of a cell as a chunk; one that fails is tried again by itself.

        Args:
            cell: the cell.
            rows: the numbers of the rows.
            beat: called at each sign of life.
            attempts: how often a row is tried in all.
            number: the number of the chunk.
        """
        watch = _Watch(beat, self.campaign.table.row_limit_s)
        drawn = self._drawn(cell, rows)
        kept = {name: np.full(len(rows), math.nan) for name in self.names}
        exceeded: dict[int, Floats] = {}
        failed = []
        for group in self._groups(drawn):
            for i, first_reason in self._evaluate(drawn, group, watch, kept, exceeded).items():
                reason, tried = first_reason, 1
                while reason and tried < attempts:
                    tried += 1
                    reason = self._evaluate(drawn, range(i, i + 1), watch, kept, exceeded).get(i, "")
                if reason:
                    failed.append(Failed(rows.start + i, self.campaign.table.seed, tried, reason))
        columns = {"row": np.arange(rows.start, rows.stop, dtype=float), "weight": drawn.weight}
        return Chunk(cell, number, columns | drawn.columns | kept, tuple(failed), *self._summed(exceeded))

    def _summed(self, exceeded: dict[int, Floats]) -> tuple[Floats, Floats]:
        """Sum and sum of squares over the rows in their order, whichever of them was tried twice."""
        if self.campaign.table.loop is None or self.campaign.table.tail is not None:
            return np.zeros(0), np.zeros(0)
        both = np.zeros((2, kernels.BINS))
        for i in sorted(exceeded):
            both += [exceeded[i], exceeded[i] ** 2]
        return both[0], both[1]

    def _drawn(self, cell: int, rows: range) -> _Rows:
        columns, weight = sampling.rows(self.campaign, cell, rows.start, len(rows))
        files: list[LinkFile | str] = []
        mirrors: list[CoupledMirror | None] = []
        keys: list[object] = []
        for i in range(len(rows)):
            values = self.fixed | {key: float(column[i]) for key, column in columns.items()}
            try:
                files.append(self.builder.mission(cell, values))
            except CampaignError as error:
                files.append(str(error))
            mirrors.append(self.builder.several_axes(cell, values))
            keys.append(self.builder.loop_key(cell, values))
        return _Rows(cell, rows.start, columns, weight, files, mirrors, keys)

    def _groups(self, drawn: _Rows) -> Iterator[range]:
        """Neighbours in the chunk that share a loop; every row by itself where nothing is simulated."""
        alone = self.campaign.table.loop is None
        for _, same in groupby(range(len(drawn.files)), key=lambda i: i if alone else drawn.keys[i]):
            places = list(same)
            yield range(places[0], places[-1] + 1)

    def _evaluate(
        self, drawn: _Rows, group: range, watch: _Watch, kept: dict[str, Floats], exceeded: dict[int, Floats]
    ) -> dict[int, str]:
        """Fill in the outputs of some rows of the chunk; returns the reason of each that failed, by place."""
        watch.start()
        try:
            runs = self._simulated(drawn, group, watch)
        except Exception as error:  # whatever it is, it is these rows', and the others go on
            return dict.fromkeys(group, _words(error))
        reasons: dict[int, str] = {}
        for i in group:
            if len(group) > 1:
                watch.start()
            try:
                found, beyond = self._outputs(drawn.files[i], runs, drawn.first + i)
            except Exception as error:
                reasons[i] = _words(error)
                continue
            if bad := [name for name, value in found.items() if not math.isfinite(value)]:
                reasons[i] = f"gives {found[bad[0]]} for {', '.join(bad)}"
                continue
            for name, value in found.items():
                kept[name][i] = value
            if beyond is not None:
                exceeded[i] = drawn.weight[i] * beyond
        return reasons

    def _outputs(
        self, file: LinkFile | str, runs: Simulated | _Weighted | None, row: int
    ) -> tuple[dict[str, float], Floats | None]:
        if isinstance(file, str):
            raise CampaignError(file)
        if isinstance(runs, _Weighted):
            return runs.row(row), None
        own = None if runs is None else runs.row(row)
        found = evaluate.outputs(file, own, self.names)
        return found, None if own is None else evaluate.exceeded(own)

    # ----------------------------------------------------------------------------------------------------------- loops
    def _simulated(self, drawn: _Rows, group: range, watch: _Watch) -> Simulated | _Weighted | None:
        """The runs of rows that share a loop, one batch after the other on this thread."""
        file = next((drawn.files[i] for i in group if isinstance(drawn.files[i], LinkFile)), None)
        if self.campaign.table.loop is None or not isinstance(file, LinkFile):
            return None
        rows = range(drawn.first + group.start, drawn.first + group.stop)
        key = (drawn.keys[group.start], rows)
        if self.memory is not None and key in self.memory:
            return self.memory[key]
        own, controller = self._loop(file, drawn.mirrors[group.start]), self.controller(drawn.cell)
        if self.campaign.table.tail is not None:
            by, firsts = self._proposal(drawn.cell), range(rows.start, rows.stop, kernels.LANES)
            parts = [importance_sampling.runs(own.row, controller, own.span, by, first, watch) for first in firsts]
            radius, log_weight = (np.concatenate(each)[: len(rows)] for each in zip(*parts, strict=True))
            return _Weighted(rows.start, radius, log_weight)
        each = self.campaign.realisations
        first, count = rows.start * each, len(rows) * each  # the numbers of the runs follow the rows'
        runs = ensemble.simulate(own.row, controller, own.span, count, first_run=first, threads=1, beat=watch)
        found = Simulated(rows.start, each, runs)
        if self.memory is not None:
            self.memory[key] = found
        return found

    def _loop(self, file: LinkFile, several_axes: CoupledMirror | None = None) -> MissionLoop:
        table = self.campaign.table.loop
        assert table is not None
        return mission_loop(file, table, self.campaign.table.seed, several_axes)

    def controller(self, cell: int) -> LoopController:
        """The controller of a cell, on the cell's own mission."""
        if cell not in self._cell_controllers:
            own = self._loop(self.builder.mission(cell, self.fixed))
            self._cell_controllers[cell] = own.controller(self.controllers[cell])
        return self._cell_controllers[cell]

    def _proposal(self, cell: int) -> importance_sampling.Proposal:
        if cell not in self._proposals:
            wanted = self.campaign.table.tail
            assert wanted is not None
            own, controller = self._loop(self.builder.mission(cell, self.fixed)), self.controller(cell)
            self._proposals[cell] = importance_sampling.proposal(own.row, controller, own.span, wanted.error_rad)
        return self._proposals[cell]

    def trace(self, cell: int, row: int, beat: Beat) -> WorstTrace:
        """The first run of a row in time, once it has settled; the output and its value are the caller's to fill in.

        Args:
            cell: the cell.
            row: the row.
            beat: called at each sign of life.

        Raises:
            CampaignError: the row's draws make no mission.
        """
        drawn = self._drawn(cell, range(row, row + 1))
        file = drawn.files[0]
        if isinstance(file, str):
            raise CampaignError(file)
        beat()
        own = self._loop(file, drawn.mirrors[0])
        found = traces.trace(own.row, self.controller(cell), own.span, row * self.campaign.realisations)
        settled = found.time_s >= own.span.settle_s
        return WorstTrace(
            cell, row, "", math.nan, found.time_s[settled], found.error_rad[settled], found.drive_v[settled]
        )


def _words(error: Exception) -> str:
    """An error in a line: the message alone where it was written for a user."""
    text = " ".join(str(error).split())
    ours = isinstance(error, ValueError | SlowRowError) and text
    return text if ours else f"{type(error).__name__}: {text}"
