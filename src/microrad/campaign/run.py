"""Runs a campaign into its ledger, from the begin or from where it stopped: rounds, second tries, worst traces."""

import heapq
import math
import os
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing, contextmanager, suppress
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path

import numpy as np

from microrad.campaign import bundle
from microrad.campaign.definition.outputs import OUTPUTS
from microrad.campaign.definition.records import CampaignFile
from microrad.campaign.engines.cluster import DaskEngine
from microrad.campaign.engines.local import LocalEngine
from microrad.campaign.file import load_campaign
from microrad.campaign.ledger import (
    Column,
    Head,
    Ledger,
    argument,
    check_same,
    chunk_format,
    mend,
    refuse_existing,
    verify,
)
from microrad.campaign.records import CampaignError, Chunk, Engine, Failed, Job, Outcome, joined
from microrad.campaign.rows import sampling
from microrad.campaign.rows.evaluator import ATTEMPTS, Evaluator
from microrad.campaign.rows.loops import controllers
from microrad.campaign.rows.plan import planned
from microrad.campaign.statistics.cell import CellRows
from microrad.campaign.statistics.intervals import ordered
from microrad.core.arrays import Floats
from microrad.core.folder import sweep_scratch
from microrad.core.progress import Progress
from microrad.core.units import format_quantity

TARGET = "microrad.campaign.work:Work"
_NEWS = 1.1  # times the rows that the quantile shown meanwhile is of, before it is computed again
_TIMED_S = 0.2  # of rows, before a campaign of links alone begins
LATE_S = 30.0
"""Without a sign of life for this long beyond the campaign's row_limit, a worker is stopped."""


@dataclass(frozen=True, slots=True)
class Means:
    """What does the work: ``threads`` or ``workers``, both processes of this machine, or a running Dask ``scheduler``.

    At most one is given; None of all is as many processes as the machine has cores.
    """

    threads: int | None = None
    workers: int | None = None
    scheduler: str | None = None

    def engine(self, spec: bytes, late_s: float) -> Engine:
        """The engine. Raises `CampaignError` where no scheduler answers.

        Args:
            spec: the campaign in one piece, see `bundle.packed`.
            late_s: how long (s) a job may give no sign of life.
        """
        if self.scheduler is not None:
            return DaskEngine(spec, TARGET, self.scheduler, late_s)
        return LocalEngine(spec, TARGET, self.threads or self.workers or os.cpu_count() or 1, late_s)


def run_campaign(
    file: str | Path,
    path: str | Path,
    means: Means = Means(),
    on_progress: Progress = lambda done, total, what: None,
) -> None:
    """Run a campaign file into a new ledger.

    Args:
        file: the campaign file.
        path: where the ledger is made.
        means: what does the work; by default as many processes as the machine has cores.
        on_progress: called with the rows done, all rows and what is said beside them.

    Raises `CampaignError` and `MissionError` for what cannot be run, and KeyboardInterrupt with words that say how to
    go on; what was finished by then is in the ledger.

    Example:
        ```python
        import microrad

        microrad.run_campaign("campaign.toml", "campaign.ledger")
        ```
    """
    file, path = Path(file), Path(path)
    campaign = load_campaign(file)
    refuse_existing(path)  # before the controllers are tuned
    plan = planned(campaign)
    if plan.is_timed:
        campaign = replace(campaign, chunk_rows=plan.timed_chunk(row_s(campaign)))
    spec = bundle.packed(campaign, controllers(campaign, on_progress))
    with (
        _closing(means.engine(spec, campaign.table.row_limit_s + LATE_S)) as engine,  # none there leaves no ledger
        Ledger.create(path, _head(campaign, spec), {"file": str(file.resolve())}) as book,
    ):
        _Runner(campaign, engine, book, on_progress).run()


def resume_campaign(path: Path, means: Means, on_progress: Progress = lambda done, total, what: None) -> None:
    """Go on with a campaign that stopped; one that is complete stays as it is. Damaged chunks are done again.

    Args:
        path: its ledger.
        means: what does the work.
        on_progress: called with the rows done, all rows and what is said beside them.

    Raises `CampaignError` with both hashes when microrad, the campaign file or the mission is no longer what it was;
    files that are no longer there are taken from the ledger.
    """
    if not verify(path).sound:
        mend(path)
    with Ledger.open(path, write=True) as book:
        head = book.head
        file = Path(book.notes().get("file", ""))
        opened = bundle.opened(head.bundle, any_code=True)
        campaign = load_campaign(file) if file.is_file() else opened.campaign
        check_same(head.hashes, bundle.hashes(campaign), path)
        with _closing(means.engine(head.bundle, opened.campaign.table.row_limit_s + LATE_S)) as engine:
            _Runner(opened.campaign, engine, book, on_progress).run()


@contextmanager
def _closing(engine: Engine) -> Iterator[Engine]:
    """Close an engine at the end, and remove what its workers on this machine left when they were killed."""
    try:
        with closing(engine):
            yield engine
    finally:
        sweep_scratch(bundle.SCRATCH)


def row_s(campaign: CampaignFile, clock: Callable[[], float] = time.perf_counter) -> float:
    """Time (s) that a row of links alone takes here: the mean of some, those of all cells in turn.

    The first one, which loads what it needs, does not count.

    Args:
        campaign: the campaign.
        clock: seconds from any time on.
    """
    evaluator, cells = Evaluator(campaign, {}), len(campaign.cells)
    began = took = 0.0
    for done in range(max(cells * campaign.rows, 2)):
        row = done // cells % campaign.rows
        evaluator.rows(done % cells, range(row, row + 1), lambda: None, attempts=1)
        began, took = (clock(), 0.0) if done == 0 else (began, clock() - began)
        if took >= _TIMED_S:
            break
    return took / done


def _head(campaign: CampaignFile, spec: bytes) -> Head:
    columns = [Column("row", "", "number of the row in its cell"), Column("weight", "", "weight of the row")]
    columns += [Column(each.key, each.unit, "drawn") for each in campaign.inputs]
    columns += [Column(output.name, output.unit, output.meaning) for output in campaign.outputs]
    return Head(
        campaign_name=campaign.path.stem,
        campaign_text=campaign.text,
        mission_name=campaign.mission.mission.name,
        seed=campaign.table.seed,
        hashes=bundle.hashes(campaign),
        versions={name: version(name) for name in ("microrad", *bundle.LIBRARIES)},
        created=datetime.now(UTC).isoformat(timespec="seconds"),
        cells=tuple(cell.values for cell in campaign.cells),
        columns=tuple(columns),
        bundle=spec,
    )


@dataclass
class _Pace:
    """Rows done here and before, the time that they took, and the first limit's output so far.

    ``quantile`` is that of the first ``quantile_of`` rows done here, in words.
    """

    done: int
    spent_s: float
    began_s: float = field(default_factory=time.monotonic)
    here: int = 0
    values: list[Floats] = field(default_factory=list)
    quantile: str = ""
    quantile_of: int = 0

    @property
    def seconds(self) -> float:
        return self.spent_s + time.monotonic() - self.began_s

    def words(self, total: int, shown: str) -> str:
        """Rate, time left and the interim quantile."""
        took = time.monotonic() - self.began_s
        if not self.here or took <= 0.0:
            return "rows"
        rate = self.here / took
        left = (total - self.done) / rate
        return ", ".join(part for part in (format_quantity(rate, "rows/s", 3), f"{_minutes(left)} left", shown) if part)


def _minutes(seconds: float) -> str:
    if seconds < 90.0:
        return f"{seconds:.0f} s"
    return f"{seconds / 60.0:.0f} min" if seconds < 5400.0 else f"{seconds / 3600.0:.1f} h"


class _Runner:
    """Has the work of a campaign done and keeps it in the ledger."""

    def __init__(self, campaign: CampaignFile, engine: Engine, book: Ledger, on_progress: Progress) -> None:
        self.campaign, self.engine, self.book, self.on_progress = campaign, engine, book, on_progress
        self.plan = planned(campaign)
        rows = sum(len(self.plan.rows_of(number)) for _, number in book.done())
        self.pace = _Pace(rows, float(book.notes().get("seconds", 0.0)))
        self.total = 0

    def run(self) -> None:
        """All rounds, then the traces; whatever stops it, what is done stays."""
        self.book.note("state", "running")
        try:
            cells = list(range(len(self.campaign.cells)))
            for rows in self.plan.rounds:
                done = self.book.done()
                jobs = [job for cell in cells for job in self.plan.chunks(cell, rows)]
                missing = [job for job in jobs if (job.cell, job.number) not in done]
                self.total = self.pace.done + sum(len(self.plan.rows_of(job.number)) for job in missing)
                self._round(missing)
                cells = [cell for cell in cells if not self._precise(cell, rows)]
            self._traces()
            self._note("complete")
        except KeyboardInterrupt:
            self.engine.close()  # that nobody writes any more says that it was stopped: no further sync of the disk
            raise KeyboardInterrupt(f"stopped; {self._stopped()}") from None
        except BaseException as error:
            self.engine.close()
            with suppress(CampaignError):
                self._note("stopped")
            if isinstance(error, CampaignError) and "campaign resume" not in str(error):
                raise CampaignError(f"{error}; {self._stopped()}") from error
            raise

    def _note(self, state: str) -> None:
        self.book.note("seconds", self.pace.seconds)
        self.book.note("state", state)

    def _stopped(self) -> str:
        path = self.book.path
        return f"{self.pace.done} rows are in {path}. Go on with: microrad campaign resume {argument(path)}"

    # ---------------------------------------------------------------------------------------------------------- rounds
    def _precise(self, cell: int, rows: int) -> bool:
        """Whether a cell's first rows know what is wanted well enough; never where nothing is wanted."""
        if self.campaign.table.precision is None:
            return False
        last = len(self.plan.chunks(cell, rows))
        first_rows = (each for each in self.book.chunks(cell) if each.number < last)
        return CellRows(self.campaign, cell, first_rows).is_precise()

    def _round(self, jobs: Sequence[Job]) -> None:
        """Do these chunks: each at most twice as a whole, then the rows of those that failed one by one."""
        failed = self._pass(jobs)
        failed = self._pass([outcome.job for outcome in failed])
        for outcome in failed:
            self._by_rows(outcome.job)

    def _outcomes(self, jobs: Sequence[Job]) -> Iterator[Outcome]:
        """Those of the engine, which is not asked for nothing: a scheduler that is not needed any more may be gone."""
        return self.engine.outcomes(iter(jobs)) if jobs else iter(())

    def _pass(self, jobs: Sequence[Job]) -> list[Outcome]:
        """Put what is done into the ledger; returns what is not."""
        missed = []
        for outcome in self._outcomes(jobs):
            if outcome.kind == "done":
                self._keep(outcome.job, outcome.payload)
            else:
                missed.append(outcome)
        return missed

    def _keep(self, job: Job, payload: bytes) -> None:
        self.book.put(job.cell, job.number, payload)
        rows = len(self.plan.rows_of(job.number))
        self.pace.done, self.pace.here = self.pace.done + rows, self.pace.here + rows
        self.book.note("seconds", self.pace.seconds)
        self.on_progress(self.pace.done, self.total, self.pace.words(self.total, self._interim(payload)))

    def _interim(self, payload: bytes) -> str:
        """The quantile of the first limit's output over the rows of this sitting, but for the last few of them.

        To sort all rows again for each chunk would be the longer the more there are.
        """
        if not self.campaign.limits:
            return ""
        limit, pace = self.campaign.limits[0], self.pace
        output = OUTPUTS[limit.output]
        pace.values.append(chunk_format.unpack_chunk(payload).columns[output.name])
        if pace.here < _NEWS * pace.quantile_of and pace.done < self.total:
            return pace.quantile
        share = 0.01 if limit.least is not None else 0.99
        value = ordered(np.concatenate(pace.values)).quantile(share)
        shown = "-" if math.isnan(value) else format_quantity(value, output.unit or "1", 3)
        pace.quantile, pace.quantile_of = f"{output.name} {100 * share:g} %: {shown}", pace.here
        return pace.quantile

    def _by_rows(self, job: Job) -> None:
        """The rows of a chunk that cannot be done whole, each by itself and at most twice; the rest have failed."""
        rows = [Job(job.cell, job.number, row, "row") for row in self.plan.rows_of(job.number)]
        found: dict[int, Chunk] = {}
        lost: dict[int, str] = {}
        for _ in range(ATTEMPTS):
            todo = [each for each in rows if each.row not in found or found[each.row].failed]
            for outcome in self._outcomes(todo):
                if outcome.kind == "done":
                    found[outcome.job.row] = chunk_format.unpack_chunk(outcome.payload)
                else:
                    lost[outcome.job.row] = outcome.reason
        parts = [found[each.row] if each.row in found else self._lost(each, lost[each.row]) for each in rows]
        parts = [replace(p, failed=tuple(replace(each, attempts=ATTEMPTS) for each in p.failed)) for p in parts]
        self._keep(job, chunk_format.pack_chunk(joined(parts)))

    def _lost(self, job: Job, reason: str) -> Chunk:
        """A row that took its worker down, or that was stopped."""
        drawn, weight = sampling.rows(self.campaign, job.cell, job.row, 1)
        columns = {"row": np.array([float(job.row)]), "weight": weight, **drawn}
        columns |= {output.name: np.array([math.nan]) for output in self.campaign.outputs}
        failed = Failed(job.row, self.campaign.table.seed, ATTEMPTS, reason)
        return Chunk(job.cell, job.number, columns, (failed,), np.zeros(0), np.zeros(0))

    # ---------------------------------------------------------------------------------------------------------- traces
    def _traces(self) -> None:
        """Keep the traces of the rows that are worst in the first limit's output, in each cell."""
        wanted = {(cell, row): value for cell in range(len(self.campaign.cells)) for row, value in self._worst(cell)}
        if not wanted:
            return
        output = self.campaign.limits[0].output
        there = {(trace.cell, trace.row) for trace in self.book.traces()}
        for trace in self.book.traces():
            if (trace.cell, trace.row) not in wanted:
                self.book.drop_trace(trace)
        jobs = [Job(cell, 0, row, "trace") for cell, row in wanted if (cell, row) not in there]
        for outcome in self._outcomes(jobs):
            if outcome.kind == "done":
                found = chunk_format.unpack_trace(outcome.payload)
                value = wanted[found.cell, found.row]
                self.book.put_trace(replace(found, output=output, value=value))

    def _worst(self, cell: int) -> list[tuple[int, float]]:
        """Rows with the worst values of the first limit's output, and the values."""
        if self.campaign.table.loop is None or self.campaign.table.tail is not None or not self.campaign.limits:
            return []
        limit = self.campaign.limits[0]
        sign = -1.0 if limit.worst_is_least else 1.0
        scored = (
            (sign * value, -int(row))
            for chunk in self.book.chunks(cell)
            for row, value in zip(chunk.columns["row"], chunk.columns[limit.output], strict=True)
            if not math.isnan(value)
        )
        return [(-row, sign * score) for score, row in heapq.nlargest(self.campaign.table.worst, scored)]
