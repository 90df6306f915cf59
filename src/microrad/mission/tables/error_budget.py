"""The table of a mission about its pointing errors in time windows: what they come from, and what has to be kept."""

from collections.abc import Iterator
from typing import Annotated, Literal, get_args

from pydantic import Field

from microrad.core.units import counted
from microrad.mission.fields import Problem, Quantity, Several, Share, Switch, Table
from microrad.mission.tables.mirror import ANGLE_MOST, Frequency, Name
from microrad.mission.tables.pointing import AngleOrZero, Statistic

Time = Annotated[float, Quantity("s", "s", above=0.0, most=1e9)]
AngleRate = Annotated[float, Quantity("rad/s", "urad/s", least=0.0, most=1e3)]
Gains = Annotated[tuple[float, ...], Several(Quantity("", least=-1e6, most=1e6))]
AngleLimit = Annotated[float, Quantity("rad", "urad", above=0.0, most=ANGLE_MOST)]

SourceClass = Literal["constant", "per-observation", "random", "process", "periodic", "drift", "transient"]
IndexName = Literal["APE", "MPE", "RPE", "PDE", "PRE", "AKE", "MKE", "RKE"]
AxesName = Literal["x", "y", "z", "radial"]
MOST_AXES = len(get_args(AxesName)) - 1

_NEEDED: dict[str, dict[str, str]] = {
    "constant": {"size": '"1 urad"'},
    "per-observation": {"size": '"1 urad"'},
    "random": {"size": '"1 urad"'},
    "process": {"size": '"1 urad"', "corner": '"1 Hz"'},
    "periodic": {"size": '"1 urad"', "frequency": '"0.2 mHz"'},
    "drift": {"rate": '"1 nrad/s"', "period": '"6 h"'},
    "transient": {"size": '"1 urad"', "decay": '"10 s"', "period": '"95 min"'},
}
_TIMES: dict[str, dict[str, str]] = {
    "APE": {},
    "AKE": {},
    **{key: {"window": '"10 ms"'} for key in ("MPE", "RPE", "MKE", "RKE")},
    **{key: {"window": '"10 ms"', "spacing": '"1 min"', "observation": '"95 min"'} for key in ("PDE", "PRE")},
}


class BudgetSource(Table):
    """One source of pointing errors."""

    kind: SourceClass = Field(
        alias="class",
        description="constant; per-observation: constant in an observation period, another in the next; random: anew "
        "from moment to moment; process: Gaussian below its corner; periodic: a sinusoid of random phase; drift: a "
        "ramp that begins anew; transient: decays and comes again",
    )
    size_rad: AngleOrZero | None = Field(
        default=None, description="value, deviation, rms, amplitude or peak, by the class"
    )
    rate_rad_s: AngleRate | None = Field(default=None, description="of a drift")
    statistic: Literal["fixed", Statistic] = Field(
        description='of a random error in time, else over the satellites; "fixed" is the same on each of them'
    )
    axes: Literal["together", "each"] = Field(
        description="together: one error reaches the axes by its gains; each: every axis has one of its own"
    )
    gains: Gains = Field(description="how much of it reaches each axis: x, y and, if there are three, z")
    corner_hz: Frequency | None = Field(default=None, description="first-order corner of a process")
    frequency_hz: Frequency | None = Field(default=None, description="of a periodic error")
    period_s: Time | None = Field(default=None, description="behind which a drift or a transient begins anew")
    decay_s: Time | None = Field(default=None, description="time constant of a transient")

    def problems(self) -> Iterator[Problem]:
        """The keys of the class, and no others; one to three axes; a noise that is stated by its deviation."""
        yield from self.choice_problems(f'class = "{self.kind}"', _NEEDED[self.kind])
        if not 1 <= len(self.gains) <= MOST_AXES:
            yield Problem("gains", f"has {counted(len(self.gains), 'item')}", "one for each axis: gains = [1.0, 1.0]")
        if self.kind == "per-observation" and self.statistic == "fixed":
            yield Problem(
                "statistic", "leaves no other one in the next observation", 'class = "constant", or how it is spread'
            )
        if self.kind == "process" and self.statistic != "1-sigma":
            yield Problem("statistic", "does not belong to a process", 'its rms: statistic = "1-sigma"')
        if self.kind == "random" and self.statistic == "fixed":
            yield Problem(
                "statistic", "does not belong to a random error", '"1-sigma", "2-sigma", "3-sigma" or "bound"'
            )


class BudgetCorrelation(Table):
    """How two sources go along with each other."""

    first: Name = Field(description="name of a source, random or constant and Gaussian")
    second: Name = Field(description="name of another one of its class")
    coefficient: Annotated[float, Quantity("", least=-1.0, most=1.0)] = Field(description="of their correlation")


class BudgetRequirement(Table):
    """One requirement on the pointing errors."""

    index: IndexName = Field(description="what of the error counts: ECSS-E-ST-60-10C")
    window_s: Time | None = Field(default=None, description="length of the window")
    spacing_s: Time | None = Field(default=None, description="from the begin of a window to that of the other")
    observation_s: Time | None = Field(
        default=None, description="time in which both windows of a PDE lie, and behind which the other of a PRE does"
    )
    confidence: Annotated[float, Share("")] = Field(description="share that keeps the limit")
    interpretation: Literal["temporal", "ensemble", "mixed"] = Field(
        description="what the share is of: the times of the worst satellite, satellites at their worst time, or both"
    )
    axes: AxesName = Field(description="one axis, or radial: off the line of sight by x and y")
    limit_rad: AngleLimit = Field(description="what has to be kept")

    def problems(self) -> Iterator[Problem]:
        """The times of the index, and no others."""
        yield from self.choice_problems(f'index = "{self.index}"', _TIMES[self.index])


class ErrorBudget(Table):
    """Pointing errors in time windows: the sources of a budget, and its requirements."""

    with_loop: Annotated[bool, Switch("")] = Field(
        description="true: what the fine-pointing loop leaves is a source, too"
    )
    sources: dict[str, BudgetSource] = Field(
        default_factory=dict, description="one table for each, [error_budget.sources.NAME]; none where the loop is all"
    )
    correlations: dict[str, BudgetCorrelation] | None = Field(
        default=None, description="one table for each, [error_budget.correlations.NAME]; all else is uncorrelated"
    )
    requirements: dict[str, BudgetRequirement] = Field(
        description="one table for each, [error_budget.requirements.NAME]"
    )

    def __hash__(self) -> int:
        """Of what is in it, in its order."""
        tables = (self.sources, self.correlations or {}, self.requirements)
        return hash((self.with_loop, *(tuple(table.items()) for table in tables)))

    @property
    def axes(self) -> int:
        """Number of axes of its sources; 2 without one."""
        return next((len(source.gains) for source in self.sources.values()), 2)

    def problems(self) -> Iterator[Problem]:
        """A source and a requirement; the same axes throughout."""
        if not self.sources and not self.with_loop:
            yield Problem("sources", "holds no source", "a table such as [error_budget.sources.alignment]")
        if not self.requirements:
            yield Problem("requirements", "holds none", "a table such as [error_budget.requirements.code_word]")
        for name, source in self.sources.items():
            if len(source.gains) != self.axes:
                yield Problem(
                    f"sources.{name}.gains",
                    f"has {counted(len(source.gains), 'item')}, and others have {self.axes}",
                    "as many each",
                )
        known = [name for name, each in self.requirements.items() if each.index in ("AKE", "MKE", "RKE")]
        if self.with_loop and known:
            yield Problem(
                f"requirements.{known[0]}.index",
                "is of what is known, and the loop leaves errors of the pointing",
                "with_loop = false, and sources of knowledge alone",
            )
        if self.with_loop and self.axes != 2:
            yield Problem("with_loop", f"has two axes, and the sources have {self.axes}", "gains for x and y")
        for name, required in self.requirements.items():
            place = {"x": 1, "y": 2, "z": 3, "radial": 2}[required.axes]
            if place > self.axes:
                yield Problem(
                    f"requirements.{name}.axes", f"needs {place} axes, and the sources have {self.axes}", "more gains"
                )
