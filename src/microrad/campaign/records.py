"""What the parts of a campaign hand to each other: rows, chunks, jobs and what is summed up of them."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Literal, NamedTuple, Protocol

import numpy as np

from microrad.core.arrays import Floats
from microrad.core.errors import MicroradError


class CampaignError(MicroradError):
    """A campaign that cannot be done as asked; the message says what, where, why and what to do."""

    page = "campaigns"


# ------------------------------------------------------------------------------------------------------------- running
@dataclass(frozen=True, slots=True)
class Failed:
    """A row without results: its number, the seed of its noise, how often it was tried, and why it failed."""

    row: int
    seed: int
    attempts: int
    reason: str


@dataclass(frozen=True, slots=True)
class Chunk:
    """The finished rows of one chunk of a cell of the grid.

    ``columns`` (rows,) by name in a fixed order: ``row`` (its number in the cell), ``weight`` (1 but for importance
    sampling), the inputs drawn by key in SI units, the outputs by name; nan in the outputs of a failed row.
    ``survival`` (bins,) is the sum over the good rows of weight times the share of the time that the radial error
    exceeded the lower edge of each bin of `pointing_loop.ensemble.bin_edges_rad`, ``survival_square`` that of the
    squared terms; both empty in a campaign without a loop.
    """

    cell: int
    number: int
    columns: dict[str, Floats]
    failed: tuple[Failed, ...]
    survival: Floats
    survival_square: Floats


class Job(NamedTuple):
    """Work for a worker: a chunk of a cell, or one row of it by itself, or the trace of a row."""

    cell: int
    number: int
    row: int = -1
    kind: Literal["chunk", "row", "trace"] = "chunk"


@dataclass(frozen=True, slots=True)
class Outcome:
    """What became of a job: the bytes that it gave, or why there are none.

    ``died``: its worker vanished; ``late``: it gave no sign of life for longer than allowed and its worker was stopped;
    ``raised``: it ended with an error, whose words are in ``reason``.
    """

    job: Job
    kind: Literal["done", "died", "late", "raised"]
    payload: bytes = b""
    reason: str = ""


class Engine(Protocol):
    """What runs jobs: worker processes here, or the workers of a cluster."""

    def outcomes(self, jobs: Iterator[Job]) -> Iterator[Outcome]:
        """Outcomes in the order in which they come; takes jobs only as fast as it can start them.

        Ends when the jobs have ended and all have an outcome. Raises `CampaignError` when nothing can run any more.
        """
        ...

    def close(self) -> None:
        """Stop at once, whatever still runs; no process is left behind. May be called twice."""
        ...


# ------------------------------------------------------------------------------------------------------------- summing
@dataclass(frozen=True, slots=True)
class Interval:
    """An estimate with the interval that holds the true value with the given confidence; nan where it is not known."""

    value: float
    low: float
    high: float
    confidence: float


@dataclass(frozen=True, slots=True)
class OutputSummary:
    """One output over the good rows of a cell.

    ``quantiles`` by probability; ``edges`` and ``counts`` are a histogram for a picture (len(edges) = len(counts) + 1).
    """

    name: str
    unit: str
    meaning: str
    rows: int
    mean: Interval
    deviation: float
    least: float
    most: float
    quantiles: dict[float, Interval]
    edges: Floats
    counts: Floats


@dataclass(frozen=True, slots=True)
class Tail:
    """How often the radial error exceeds a radius, with its interval, by radius (rad), rising.

    ``wanted`` are radii exceeded with a probability, an interval each. ``method`` says where it comes from;
    ``effective_runs`` is the number of independent draws of one error that would know the ``wanted`` probability as
    well, nan where none is wanted. ``beyond`` are probabilities of a larger error than a radius that was asked for,
    and ``variance`` the variances of these estimates in importance sampling.
    """

    radius_rad: Floats
    survival: Floats
    low: Floats
    high: Floats
    wanted: dict[float, Interval]
    confidence: float
    method: str
    effective_runs: float
    beyond: dict[float, Interval] = field(default_factory=dict)
    variance: dict[float, float] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class CellSummary:
    """One cell of the grid: ``values`` are the texts of its grid keys (empty without a grid).

    ``missed`` is the probability that a row misses any limit, ``missed_by`` that it misses each by name.
    """

    values: dict[str, str]
    rows: int
    failed: int
    outputs: dict[str, OutputSummary]
    missed: Interval
    missed_by: dict[str, Interval]
    tail: Tail | None

    @property
    def label(self) -> str:
        """The cell in words."""
        return ", ".join(f"{key} = {value}" for key, value in self.values.items())


@dataclass(frozen=True, slots=True)
class Sensitivity:
    """How the inputs act on one output, from the rows as they were drawn.

    ``first`` and ``total`` are Sobol indices by input key with their intervals (``total`` empty where no surrogate was
    good enough), ``rank_correlation`` Spearman's. ``surrogate_q2`` is the surrogate's leave-one-out score, 1 at best.
    """

    output: str
    rows: int
    first: dict[str, Interval]
    total: dict[str, Interval]
    rank_correlation: dict[str, Interval]
    surrogate_q2: float
    note: str


@dataclass(frozen=True, slots=True)
class WorstTrace:
    """The row that an output is worst in, in time: ``error_rad`` (samples, axes) at the line of sight."""

    cell: int
    row: int
    output: str
    value: float
    time_s: Floats
    error_rad: Floats
    drive_v: Floats


@dataclass(frozen=True, slots=True)
class InputText:
    """A drawn input in words: "normal, mean 5 W, deviation 0.2 W", and the unit of its column."""

    key: str
    unit: str
    distribution: str


@dataclass(frozen=True, slots=True)
class Limit:
    """What an output of each row has to keep: ``most`` or ``least`` in the output's unit, None where there is none."""

    output: str
    least: float | None
    most: float | None
    source: str

    @property
    def worst_is_least(self) -> bool:
        """Whether the worst value is the least one, as for each limit with ``least``; else it is the largest."""
        return self.least is not None


@dataclass(frozen=True, slots=True)
class Progress:
    """How far a campaign is: rows done and to do (those of the first round where a precision decides), and its pace."""

    rows_done: int
    rows_total: int
    seconds: float
    rows_per_s: float
    left_s: float
    state: Literal["waiting", "running", "stopped", "complete"]


@dataclass(frozen=True, slots=True)
class CampaignSummary:
    """Everything that a status, a page or a picture shows of a campaign.

    ``sample`` are columns of at most some thousand rows of all cells, spread evenly, with ``cell`` among them, for
    scatter plots. ``sensitivities`` are of the first cell, ``worst`` those of each cell, the worst first. ``findings``
    are sentences that belong beside the verdict.
    """

    name: str
    mission_name: str
    hashes: dict[str, str]
    seed: int
    sampling: str
    loop: str
    inputs: tuple[InputText, ...]
    fixed: dict[str, str]
    limits: tuple[Limit, ...]
    cells: tuple[CellSummary, ...]
    sensitivities: tuple[Sensitivity, ...]
    sample: dict[str, Floats]
    worst: tuple[WorstTrace, ...]
    failed: tuple[tuple[int, Failed], ...]
    progress: Progress
    warnings: tuple[str, ...] = field(default=())
    findings: tuple[str, ...] = field(default=())


def joined(parts: Sequence[Chunk]) -> Chunk:
    """One chunk of the rows of these chunks of a cell, one behind the other, with the number of the first."""
    names = parts[0].columns
    sums = [chunk for chunk in parts if chunk.survival.size]
    zeros = np.zeros(sums[0].survival.size) if sums else np.zeros(0)
    return Chunk(
        parts[0].cell,
        parts[0].number,
        {name: np.concatenate([chunk.columns[name] for chunk in parts]) for name in names},
        tuple(failed for chunk in parts for failed in chunk.failed),
        sum((chunk.survival for chunk in sums), zeros),
        sum((chunk.survival_square for chunk in sums), zeros),
    )
