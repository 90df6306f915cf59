"""What a worker does: the rows of a chunk, one row by itself, or the trace of a row; the same bytes everywhere."""

import hashlib
import math
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from itertools import groupby

import numpy as np

from microrad.campaign import blob, bundle, evaluate, loops, plan, sampling, tilt
from microrad.campaign.bundle import code_sha256
from microrad.campaign.definition import CampaignFile
from microrad.campaign.inputs import Builder
from microrad.campaign.records import CampaignError, Chunk, Failed, Job, WorstTrace
from microrad.core import kernels
from microrad.core.arrays import Floats
from microrad.loop.control import AxisController
from microrad.loop.pointing_loop import ensemble, traces
from microrad.loop.pointing_loop.loop import LoopController, PointingLoop
from microrad.mission.file import LinkFile

__all__ = ["Work", "code_sha256", "open_work"]

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
    """Drawn rows of a cell: the inputs' columns, weights, and a mission or the reason why there is none."""

    cell: int
    first: int
    columns: dict[str, Floats]
    weight: Floats
    files: list[LinkFile | str]
    keys: list[object]


class Evaluator:
    """Evaluates rows of a campaign; its methods may be called from several threads.

    ``fixed`` are values of mission keys that all rows have, ``controllers`` those of the cells. With a ``memory``, rows
    whose loop was simulated before are not simulated again.
    """

    def __init__(
        self,
        campaign: CampaignFile,
        builder: Builder,
        fixed: Mapping[str, float],
        controllers: Mapping[int, AxisController],
        memory: "dict[object, loops.Simulated] | None" = None,
    ) -> None:
        """Nothing is computed yet."""
        self.campaign, self.builder, self.fixed, self.controllers = campaign, builder, fixed, controllers
        self.memory = memory
        self.names = tuple(output.name for output in plan.outputs(campaign))
        self._held: dict[int, LoopController] = {}
        self._tilts: dict[int, tilt.Tilt] = {}

    # ----------------------------------------------------------------------------------------------------------- rows
    def rows(self, cell: int, rows: range, beat: Beat, attempts: int = ATTEMPTS, number: int = 0) -> Chunk:
        """Rows of a cell as chunk ``number``; one that fails is tried again by itself, ``attempts`` times in all."""
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
        keys: list[object] = []
        for i in range(len(rows)):
            values = dict(self.fixed) | {key: float(column[i]) for key, column in columns.items()}
            try:
                files.append(self.builder.mission(cell, values))
            except CampaignError as error:
                files.append(str(error))
            keys.append(self.builder.loop_key(cell, values))
        return _Rows(cell, rows.start, columns, weight, files, keys)

    def _groups(self, drawn: _Rows) -> Iterator[range]:
        """Neighbours in the chunk that share a loop; every row by itself where nothing is simulated."""
        if self.campaign.table.loop is None:
            yield from (range(i, i + 1) for i in range(len(drawn.files)))
            return
        at = 0
        for _, same in groupby(drawn.keys):
            count = sum(1 for _ in same)
            yield range(at, at + count)
            at += count

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

    def _simulated(self, drawn: _Rows, group: range, watch: _Watch) -> "loops.Simulated | _Tilted | None":
        table = self.campaign.table.loop
        file = next((drawn.files[i] for i in group if isinstance(drawn.files[i], LinkFile)), None)
        if table is None or not isinstance(file, LinkFile):
            return None
        rows = range(drawn.first + group.start, drawn.first + group.stop)
        key = (drawn.keys[group.start], rows)
        if self.memory is not None and key in self.memory:
            return self.memory[key]
        loop, controller = loops.row_loop(file, table), self.controller(drawn.cell)
        span = loops.span(self.campaign, loops.settings(file))
        if self.campaign.table.tail is not None:
            return _Tilted.run(self._tilt(drawn.cell), loop, controller, span, rows, watch)
        found = loops.simulate(loop, controller, span, rows, self.campaign.realisations, watch)
        if self.memory is not None:
            self.memory[key] = found
        return found

    def _outputs(
        self, file: LinkFile | str, runs: "loops.Simulated | _Tilted | None", row: int
    ) -> tuple[dict[str, float], Floats | None]:
        if isinstance(file, str):
            raise CampaignError(file)
        if isinstance(runs, _Tilted):
            return runs.row(row), None
        own = None if runs is None else runs.row(row)
        found = evaluate.outputs(file, own, self.names)
        return found, None if own is None else evaluate.exceeded(own)

    # ----------------------------------------------------------------------------------------------------------- loops
    def controller(self, cell: int) -> LoopController:
        """The controller of a cell, on the cell's own mission."""
        if cell not in self._held:
            table = self.campaign.table.loop
            assert table is not None
            file = self.builder.mission(cell, self.fixed)
            self._held[cell] = loops.held(loops.scene(file, table), table, self.controllers[cell])
        return self._held[cell]

    def _tilt(self, cell: int) -> tilt.Tilt:
        if cell not in self._tilts:
            table, wanted = self.campaign.table.loop, self.campaign.table.tail
            assert table is not None and wanted is not None
            file = self.builder.mission(cell, self.fixed)
            loop, span = loops.row_loop(file, table), loops.span(self.campaign, loops.settings(file))
            self._tilts[cell] = tilt.tilt(loop, self.controller(cell), span, wanted.error_rad)
        return self._tilts[cell]

    def trace(self, cell: int, row: int, beat: Beat) -> WorstTrace:
        """The first run of a row in time, once it has settled; the output and its value are the caller's to fill in."""
        table, file = self.campaign.table.loop, self._drawn(cell, range(row, row + 1)).files[0]
        assert table is not None
        if isinstance(file, str):
            raise CampaignError(file)
        beat()
        loop, span = loops.row_loop(file, table), loops.span(self.campaign, loops.settings(file))
        found = traces.trace(loop, self.controller(cell), span, row * self.campaign.realisations)
        settled = found.time_s >= span.settle_s
        return WorstTrace(
            cell, row, "", math.nan, found.time_s[settled], found.error_rad[settled], found.drive_v[settled]
        )


class Work:
    """A campaign, opened by a worker."""

    def __init__(self, spec: bytes) -> None:
        """Open what `bundle.packed` put together, and load the compiled loop, so that no job waits for it.

        Raises `CampaignError` when other code packed it.
        """
        self.opened = bundle.opened(spec)
        self.campaign = self.opened.campaign
        controllers = dict(enumerate(self.opened.controllers))
        self.evaluator = Evaluator(self.campaign, Builder(self.campaign), {}, controllers)
        if controllers:
            self._warm_up()

    def _warm_up(self) -> None:
        table = self.campaign.table.loop
        assert table is not None
        period = 1.0 / loops.settings(self.campaign.mission).rate_hz
        loop, controller = loops.row_loop(self.campaign.mission, table), self.evaluator.controller(0)
        traces.trace(loop, controller, ensemble.Span(2.0 * period, 0.0, 0))

    def do(self, job: Job, beat: Beat) -> bytes:
        """A chunk (`blob.pack_chunk`), a chunk of one row, or a trace (`blob.pack_trace`), as the job asks."""
        if job.kind == "trace":
            return blob.pack_trace(self.evaluator.trace(job.cell, job.row, beat))
        if job.kind == "row":
            found = self.evaluator.rows(job.cell, range(job.row, job.row + 1), beat, attempts=1, number=job.number)
        else:
            rows = plan.rows_of(self.campaign, job.number)
            found = self.evaluator.rows(job.cell, rows, beat, number=job.number)
        return blob.pack_chunk(found)


@dataclass(frozen=True, slots=True)
class _Tilted:
    """Tilted runs of consecutive rows, one each."""

    first_row: int
    radius_rad: Floats
    log_weight: Floats

    @classmethod
    def run(
        cls,
        tilted: tilt.Tilt,
        loop: PointingLoop,
        controller: LoopController,
        span: ensemble.Span,
        rows: range,
        watch: Beat,
    ) -> "_Tilted":
        parts = [
            tilt.tilted(loop, controller, span, tilted, first, watch)
            for first in range(rows.start, rows.stop, kernels.LANES)
        ]
        radius, weight = (np.concatenate(each)[: len(rows)] for each in zip(*parts, strict=True))
        return cls(rows.start, radius, weight)

    def row(self, row: int) -> dict[str, float]:
        """The two outputs of a row."""
        at = row - self.first_row
        return {"tail_radius": float(self.radius_rad[at]), "tail_log_weight": float(self.log_weight[at])}


def _words(error: Exception) -> str:
    """An error in a line: the message alone where it was written for a user."""
    text = " ".join(str(error).split())
    ours = isinstance(error, ValueError | SlowRowError) and text
    return text if ours else f"{type(error).__name__}: {text}"


def open_work(spec: bytes) -> Work:
    """The work of a campaign; kept, so that the next job of the same campaign finds it open."""
    return _open(hashlib.sha256(spec).digest(), spec)


@lru_cache(maxsize=2)
def _open(_: bytes, spec: bytes) -> Work:
    return Work(spec)
