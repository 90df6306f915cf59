"""What a worker does: the rows of a chunk, one row by itself, or the trace of a row; the same bytes everywhere."""

from collections.abc import Callable

from microrad.campaign.bundle import code_sha256, opened
from microrad.campaign.ledger import chunk_format
from microrad.campaign.records import Job
from microrad.campaign.rows.evaluator import Evaluator
from microrad.campaign.rows.loops import mission_loop
from microrad.campaign.rows.plan import planned
from microrad.loop.pointing_loop import ensemble, traces

__all__ = ["Work", "code_sha256"]


class Work:
    """A campaign, opened by a worker."""

    def __init__(self, spec: bytes) -> None:
        """Open what `bundle.packed` put together, and load the compiled loop, so that no job waits for it.

        Raises `CampaignError` when other code packed it.
        """
        self.opened = opened(spec)
        self.campaign = self.opened.campaign
        self.plan = planned(self.campaign)
        self.evaluator = Evaluator(self.campaign, dict(enumerate(self.opened.controllers)))
        if self.campaign.table.loop is not None:
            loop = mission_loop(self.campaign.mission, self.campaign.table.loop, 0).row
            traces.trace(loop, self.evaluator.controller(0), ensemble.Span(2.0 * loop.timing.period_s, 0.0, 0))

    def do(self, job: Job, beat: Callable[[], None]) -> bytes:
        """A chunk, a chunk of one row, or a trace, as the job asks, in the format that the ledger keeps.

        Args:
            job: what to do.
            beat: called at each sign of life.
        """
        if job.kind == "trace":
            return chunk_format.pack_trace(self.evaluator.trace(job.cell, job.row, beat))
        if job.kind == "row":
            found = self.evaluator.rows(job.cell, range(job.row, job.row + 1), beat, attempts=1, number=job.number)
        else:
            found = self.evaluator.rows(job.cell, self.plan.rows_of(job.number), beat, number=job.number)
        return chunk_format.pack_chunk(found)
