"""The tables of a campaign file, in the words of its keys."""

from dataclasses import dataclass
from typing import Annotated, Any, Literal

from pydantic import Field

from microrad.mirror import Variant
from microrad.mission.fields import Quantity, Share, Table, Whole
from microrad.mission.tables.mirror import Name

MOST_RUNS = 2**32
"""Runs of a cell, rows times realisations: the number of a run is one word of its noise stream's counter."""

Seconds = Annotated[float, Quantity("s", "s", above=0.0, most=1e9)]


@dataclass(frozen=True, slots=True)
class _Mostly(Share):
    """A share of rows, or of the time, that is most of it."""

    @property
    def example(self) -> str:
        """Such a share."""
        return "0.99"


class LoopTable(Table):
    """The fine-pointing loop that is simulated."""

    controller: Name = Field(description="name of a controller of the mission's fine-pointing study")
    axes: Literal["both", "one"] = Field(default="both", description="one: the design axis alone")
    mirror: Literal[Variant.GIVEN, Variant.COMPARISON, Variant.STRAIGHT] = Variant.GIVEN
    duration_s: Seconds | None = Field(alias="duration", default=None, description="absent: fine_pointing.duration")
    settle_s: Annotated[float, Quantity("s", "s", least=0.0, most=1e9)] | None = Field(
        alias="settle", default=None, description="absent: fine_pointing.settle"
    )


class LimitTable(Table):
    """What an output has to keep, in its own unit."""

    least: Any = None
    most: Any = None


class PrecisionTable(Table):
    """When to stop: once the interval of a quantile is narrow enough."""

    output: Name = Field(description='an output of the rows, or "radius", the radial error over the time of all rows')
    quantile: Annotated[float, _Mostly("")]
    half_width: Any
    confidence: Annotated[float, _Mostly("")]
    at_most: Annotated[int, Whole("", least=1, most=MOST_RUNS)] = Field(description="rows of a cell")


class TailTable(Table):
    """A radial error so rare that the noise is shifted towards it."""

    error_rad: Annotated[float, Quantity("rad", "urad", above=0.0, most=1.0)] = Field(alias="error")
    probability: Annotated[float, Share("")]


class VariableTable(Table):
    """Bounds of a design variable."""

    low: Any
    high: Any


class OptimiseTable(Table):
    """What an optimisation changes, and what for."""

    minimise: Name = Field(description="a variable or an output; with - before it, it is maximised")
    confidence: Annotated[float, _Mostly("")] = Field(description="share of the rows that keep each limit")
    rows: Annotated[int, Whole("", least=16, most=1_000_000)]
    evaluations: Annotated[int, Whole("", least=1, most=100_000)]
    variables: dict[str, VariableTable]


class CampaignTable(Table):
    """A campaign file. What names keys of the mission or outputs stays as it is written, and is read apart."""

    mission: Name = Field(description="path of the mission file, seen from this one")
    seed: Annotated[int, Whole("", least=0, most=2**64 - 1)]
    runs: Annotated[int, Whole("", least=1, most=MOST_RUNS)] = Field(description="rows of each cell")
    sampling: Literal["random", "latin-hypercube", "sobol"]
    realisations: Annotated[int, Whole("", least=1, most=1_000_000)] | None = Field(
        default=None, description="runs of the loop's noise for each row"
    )
    row_limit_s: Seconds = Field(alias="row_limit", default=300.0, description="a row that takes longer has failed")
    worst: Annotated[int, Whole("", least=0, most=100)] = Field(default=3, description="rows whose trace is kept")
    loop: LoopTable | None = None
    precision: PrecisionTable | None = None
    tail: TailTable | None = None
    optimise: OptimiseTable | None = None
    keep: Any = Field(default=None, description="outputs; absent: all but those of the day")
    fixed: Any = Field(alias="set", default=None, description="values in place of the mission's")
    inputs: Any = Field(default=None, description="what is drawn, a table for each key")
    grid: Any = Field(default=None, description="lists of values by key, of which every combination is a cell")
    limits: Any = Field(default=None, description="what outputs have to keep; absent: as the mission requires")
