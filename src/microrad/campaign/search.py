"""The optimisation of a campaign file: its candidates' rows, evaluated on the threads of this machine."""

from functools import partial
from itertools import pairwise
from pathlib import Path

import numpy as np

from microrad.campaign import loops, plan, work
from microrad.campaign.candidates import Problem, Variable
from microrad.campaign.definition import CampaignFile
from microrad.campaign.file import load_campaign
from microrad.campaign.inputs import Builder
from microrad.campaign.keys import touches_loop
from microrad.campaign.optimise import Optimum, optimise
from microrad.campaign.records import CampaignError
from microrad.core.arrays import Floats
from microrad.core.progress import Progress
from microrad.core.threads import in_threads
from microrad.loop.control import AxisController

_PARTS = 8  # that the rows of a candidate are shared out in, at most


def run(file: Path, threads: int | None = None, on_progress: Progress = lambda done, total, what: None) -> Optimum:
    """The optimum of a campaign file's table `optimise`, on the first cell of its grid.

    Raises `CampaignError` for a file without that table, and for a problem that cannot be searched.
    """
    campaign = load_campaign(file)
    wanted = campaign.table.optimise
    if wanted is None:
        raise CampaignError(f"{file}: there is no table [optimise] in it, so nothing says what to optimise")
    variables = tuple(Variable(v.key, v.unit, v.low, v.high) for v in campaign.variables)
    problem = Problem(
        variables, wanted.minimise, campaign.limits, wanted.confidence, wanted.evaluations, campaign.table.seed
    )
    candidates = _Candidates(campaign, wanted.rows, threads)
    fresh = partial(candidates.columns, first=wanted.rows)
    return optimise(problem, candidates.columns, fresh, on_progress)


class _Candidates:
    """The rows of each candidate: the same draws and noise for all, so that their differences are their own."""

    def __init__(self, campaign: CampaignFile, rows: int, threads: int | None) -> None:
        self.campaign, self.rows, self.threads = campaign, rows, threads
        self.builder = Builder(campaign)
        self.controllers: dict[object, AxisController] = {}
        own = campaign.mission.mission
        moving = any(touches_loop(variable.key, own) for variable in campaign.variables)
        self.memory: dict[object, loops.Simulated] | None = None if moving else {}  # the runs of all candidates

    def columns(self, x: Floats, first: int = 0) -> dict[str, Floats]:
        """Outputs (rows,) by name at these variables, from row ``first`` on; `CampaignError` where there is no loop."""
        values = {variable.key: float(value) for variable, value in zip(self.campaign.variables, x, strict=True)}
        evaluator = work.Evaluator(self.campaign, self.builder, values, self._controller(values), self.memory)
        edges = np.unique(np.linspace(first, first + self.rows, _PARTS + 1).astype(int)).tolist()
        jobs = [partial(evaluator.rows, 0, range(a, b), _still) for a, b in pairwise(edges)]
        parts = in_threads(jobs, workers=self.threads)
        names = ("weight", *(output.name for output in plan.outputs(self.campaign)))
        return {name: np.concatenate([part.columns[name] for part in parts]) for name in names}

    def _controller(self, values: dict[str, float]) -> dict[int, AxisController]:
        """The controller tuned for these variables, where they touch the loop, else that of the mission."""
        table = self.campaign.table.loop
        if table is None:
            return {}
        key = self.builder.loop_key(0, values)
        if key not in self.controllers:
            self.controllers[key] = loops.tuned(self.builder.mission(0, values), table)
        return {0: self.controllers[key]}


def _still() -> None:
    """No sign of life is waited for."""
