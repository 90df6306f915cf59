"""The optimisation of a campaign file: its candidates' rows, evaluated on the threads of this machine."""

from functools import partial
from itertools import pairwise
from pathlib import Path

import numpy as np

from microrad.campaign.definition.keys import touches_loop
from microrad.campaign.definition.records import CampaignFile
from microrad.campaign.file import load_campaign
from microrad.campaign.optimisation.candidates import Problem
from microrad.campaign.optimisation.search import Optimum, optimise
from microrad.campaign.records import CampaignError
from microrad.campaign.rows.evaluator import Evaluator, Simulated
from microrad.campaign.rows.loops import ControllerTuner
from microrad.core.arrays import Floats
from microrad.core.progress import Progress
from microrad.core.threads import in_threads

_PARTS = 8  # that the rows of a candidate are shared out in, at most


def optimise_campaign(
    file: Path, threads: int | None = None, on_progress: Progress = lambda done, total, what: None
) -> Optimum:
    """The optimum of a campaign file's table `optimise`, on the first cell of its grid.

    Args:
        file: the campaign file.
        threads: how many evaluate rows; None: as many as there are cores.
        on_progress: called with the candidates done, the most there may be, and the best cost so far in words.

    Raises `CampaignError` for a file without that table, and for a problem that cannot be searched.
    """
    campaign = load_campaign(file)
    wanted, seed = campaign.table.optimise, campaign.table.seed
    if wanted is None:
        raise CampaignError(f"{file}: there is no table [optimise] in it, so nothing says what to optimise")
    problem = Problem(campaign.variables, wanted.minimise, campaign.limits, wanted.confidence, wanted.evaluations, seed)
    candidates = _CandidateRows(campaign, wanted.rows, threads)
    return optimise(problem, candidates.columns, partial(candidates.columns, first=wanted.rows), on_progress)


class _CandidateRows:
    """The rows of each candidate: the same draws and noise for all, so that their differences are their own."""

    def __init__(self, campaign: CampaignFile, rows: int, threads: int | None) -> None:
        self.campaign, self.rows, self.threads = campaign, rows, threads
        self.tuner = ControllerTuner(campaign)
        moving = any(touches_loop(variable.key, campaign.mission.mission) for variable in campaign.variables)
        self.memory: dict[object, Simulated] | None = None if moving else {}  # the runs of all candidates

    def columns(self, x: Floats, first: int = 0) -> dict[str, Floats]:
        """Outputs (rows,) by name at these variables, from row ``first`` on. Raises `CampaignError`."""
        values = {variable.key: float(value) for variable, value in zip(self.campaign.variables, x, strict=True)}
        controllers = {} if self.campaign.table.loop is None else {0: self.tuner.tuned(0, values)}
        evaluator = Evaluator(self.campaign, controllers, values, self.memory)
        edges = np.unique(np.linspace(first, first + self.rows, _PARTS + 1).astype(int)).tolist()
        jobs = [partial(evaluator.rows, 0, range(a, b), lambda: None) for a, b in pairwise(edges)]
        parts = in_threads(jobs, workers=self.threads)
        names = ("weight", *(output.name for output in self.campaign.outputs))
        return {name: np.concatenate([part.columns[name] for part in parts]) for name in names}
