"""A mission's budget of pointing errors, from its table, from a list beside it, and from its own loop."""

import math
from collections.abc import Mapping

import numpy as np

from microrad.link.error_budget.contributions import Contribution, Requirement
from microrad.link.error_budget.correlation import Correlation
from microrad.link.error_budget.distributions import Part, case
from microrad.link.error_budget.sources import ErrorSource, Spread
from microrad.link.pointing.error_classes import SIGMAS
from microrad.loop.disturbance import first_order
from microrad.loop.disturbance.windows import ErrorIndex
from microrad.loop.pointing_loop.linear import ClosedLoop
from microrad.loop.pointing_loop.windows import windowed_lines, windowed_noise
from microrad.mission.tables.error_budget import BudgetRequirement, BudgetSource, ErrorBudget

_LOOP = "the mission's fine-pointing loop"
_PLACES = {"x": (0,), "y": (1,), "z": (2,), "radial": (0, 1)}


def source_of(name: str, stated: BudgetSource, origin: str) -> ErrorSource:
    """A source as the engine takes it.

    A random error is as its statistic says in time; all others are over the satellites: fixed, Gaussian about zero, or
    evenly spread up to their bound. A size that is given about zero is so on each satellite, so that a constant of
    three sigma is three times its deviation on the worst.

    Args:
        name: What it is called.
        stated: The source as a mission or a list states it.
        origin: Where its numbers come from.
    """
    size = stated.rate_rad_s if stated.kind == "drift" else stated.size_rad
    assert size is not None
    sigma = size / SIGMAS.get(stated.statistic, 1.0)
    gains, apart = np.asarray(stated.gains, dtype=float), stated.axes == "each"
    if stated.kind == "random":
        return ErrorSource(
            name,
            "random",
            Spread("fixed", sigma),
            gains,
            apart=apart,
            even_in_time=stated.statistic == "bound",
            origin=origin,
        )
    if stated.kind == "process":
        assert stated.corner_hz is not None
        level = 2.0 / (math.pi * stated.corner_hz)  # of an rms of 1
        shape = first_order(level, stated.corner_hz, convention="per-axis", name=name)
        return ErrorSource(name, "process", Spread("fixed", sigma), gains, process=shape, apart=apart, origin=origin)
    spread = {"fixed": Spread("fixed", size), "bound": Spread("uniform", 0.0, size)}
    return ErrorSource(
        name,
        stated.kind,
        spread.get(stated.statistic, Spread("gaussian", 0.0, sigma)),
        gains,
        freq_hz=stated.frequency_hz,
        period_s=stated.period_s,
        decay_s=stated.decay_s,
        apart=apart,
        origin=origin,
    )


def sources_of(table: ErrorBudget, origins: Mapping[str, str]) -> tuple[ErrorSource, ...]:
    """The sources of a mission's table.

    Args:
        table: The table.
        origins: Where the numbers of each source come from, by its name.
    """
    return tuple(source_of(name, stated, origins[name]) for name, stated in table.sources.items())


def correlations_of(table: ErrorBudget | None) -> tuple[Correlation, ...]:
    """The correlations of a mission's table; none without one.

    Args:
        table: The table.
    """
    stated = {} if table is None or table.correlations is None else table.correlations
    return tuple(Correlation(each.first, each.second, each.coefficient) for each in stated.values())


def requirement_of(stated: BudgetRequirement) -> Requirement:
    """A requirement as the engine takes it.

    Args:
        stated: The requirement as a mission states it.

    Raises:
        ValueError: As `Requirement`.
    """
    return Requirement(
        ErrorIndex(stated.index, stated.window_s, stated.spacing_s),
        stated.confidence,
        stated.interpretation,
        _PLACES[stated.axes],
        stated.limit_rad,
        stated.observation_s,
    )


def loop_contributions(closed: ClosedLoop, required: Requirement) -> tuple[Contribution, ...]:
    """What the linear loop leaves, by its sources: a Gaussian, and each line, whose phases differ by axis.

    Under "ensemble" it stands as it does in time.

    Args:
        closed: The loop under its controller.
        required: The index.

    Raises:
        ValueError: As `windowed` of a loop.
    """
    parts: dict[str, list[Part]] = {}
    for source, each in windowed_noise(closed, required.index).items():
        parts.setdefault(source, []).append(case(len(each), covariance=np.diag(each)))
    for line, variance in windowed_lines(closed, required.index):
        amplitudes = np.diag(np.sqrt(2.0 * np.maximum(variance, 0.0))).astype(complex)
        parts.setdefault(line, []).extend(case(len(variance), amplitude=each) for each in amplitudes if each.any())
    return tuple(Contribution(name, "loop", tuple(each), _LOOP) for name, each in parts.items() if each)
