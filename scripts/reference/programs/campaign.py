"""`python -m microrad` with the rows of campaigns computed in this process: a worker takes a second to start."""

from collections.abc import Iterable, Iterator
from functools import cached_property
from itertools import count
from typing import Any

from microrad.campaign import run
from microrad.campaign.engines import worker
from microrad.campaign.records import Job, Outcome
from microrad.cli import main


class Here:
    """An engine without a worker: it does one job after the other in this process."""

    def __init__(self, spec: Any) -> None:
        """None done yet.

        Args:
            spec: What a worker is given.
        """
        self.spec = spec

    @cached_property
    def work(self) -> Any:
        """What does the jobs, opened once."""
        return worker.open_target(run.TARGET, self.spec)

    def outcomes(self, jobs: Iterable[Job]) -> Iterator[Outcome]:
        """Do the jobs, in their order."""
        for job in jobs:
            try:
                outcome = Outcome(job, "done", self.work.do(job, lambda: None))
            except Exception as error:
                outcome = Outcome(job, "raised", reason=worker.words(error))
            yield outcome

    def close(self) -> None:
        """Nothing is open."""


if __name__ == "__main__":
    run.Means.engine = lambda means, spec, late_s: Here(spec)
    # Measured by a clock that ticks: on a slow machine a row takes longer, and a chunk has fewer of them.
    ticks, measured = count(), run.row_s
    run.row_s = lambda campaign: measured(campaign, lambda: 0.001 * next(ticks))
    main()
