"""A mission's budget of pointing errors, from its table, from a list beside it, and from its own loop."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from microrad.core.arrays import Floats
from microrad.link.error_budget.budget import Share, Total, beyond, shares, total
from microrad.link.error_budget.contributions import Contribution, Requirement, contributions
from microrad.link.error_budget.correlation import Correlation, correlated
from microrad.link.error_budget.distributions import Part, case
from microrad.link.error_budget.sources import ErrorSource, Spread
from microrad.link.pointing.error_classes import SIGMAS
from microrad.loop.disturbance import first_order, psd
from microrad.loop.disturbance.windows import ErrorIndex
from microrad.loop.pointing_loop.linear import ClosedLoop, residual_spectrum
from microrad.loop.pointing_loop.windows import windowed_lines, windowed_noise
from microrad.mission.model import Source, source_text
from microrad.mission.tables.error_budget import BudgetRequirement, BudgetSource, ErrorBudget

_LOOP = "the mission's fine-pointing loop under"
_PLACES = {"x": (0,), "y": (1,), "z": (2,), "radial": (0, 1)}
_BINS, _SIZES, _BEYOND = 320, 97, 1.3  # frequencies, sizes of an error, and how far these reach beyond total and limit
_AROUND = 30.0  # times the corners and the windows, to either side of the frequencies


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
            statistic=stated.statistic,
        )
    if stated.kind == "process":
        assert stated.corner_hz is not None
        level = 2.0 / (math.pi * stated.corner_hz)  # of an rms of 1
        shape = first_order(level, stated.corner_hz, convention="per-axis", name=name)
        return ErrorSource(
            name,
            "process",
            Spread("fixed", sigma),
            gains,
            process=shape,
            apart=apart,
            origin=origin,
            statistic=stated.statistic,
        )
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
        statistic=stated.statistic,
    )


def sources_of(table: ErrorBudget, sources: Mapping[str, Source]) -> tuple[ErrorSource, ...]:
    """The sources of a mission's table.

    Args:
        table: The table.
        sources: Where each value of the mission comes from, by its dotted key.
    """
    return tuple(
        source_of(name, stated, source_text(sources, size_key(name, stated.kind)))
        for name, stated in table.sources.items()
    )


def size_key(name: str, kind: str) -> str:
    """The key of a mission that says how large a source is.

    Args:
        name: What it is called.
        kind: Its class.
    """
    return f"error_budget.sources.{name}.{'rate' if kind == 'drift' else 'size'}"


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
    origin = f"{_LOOP} {closed.controller.name}"
    return tuple(Contribution(name, "loop", tuple(each), origin, "rms") for name, each in parts.items() if each)


# --------------------------------------------------------------------------------------------------- a mission's budget
@dataclass(frozen=True, slots=True)
class Stated:
    """What is asked of the pointing errors of a mission, and what its sources add to that; its loop is not in it yet.

    ``required`` are the requirements by their names, ``added`` what the sources add to each; ``with_loop`` says whether
    what the fine-pointing loop leaves is a source, too.
    """

    sources: tuple[ErrorSource, ...]
    required: Mapping[str, Requirement]
    added: Mapping[str, tuple[Contribution, ...]]
    with_loop: bool


@dataclass(frozen=True, slots=True)
class Judged:
    """A requirement with what the budget comes to under it.

    Args:
        name: What the requirement is called.
        total: The total.
        shares: What each source means for it, that of the largest growth first.
        size_rad: Sizes of an error (rad), shape (sizes,), rising from 0 to beyond total and limit.
        beyond: Probability of a larger one, shape (sizes,).
    """

    name: str
    total: Total
    shares: tuple[Share, ...]
    size_rad: Floats
    beyond: Floats


@dataclass(frozen=True, slots=True)
class PointingErrorBudget:
    """The budget of a mission's pointing errors.

    Args:
        judged: The requirements, as the mission has them.
        freq_hz: Frequencies of the spectra (Hz), shape (frequencies,); none where no source has a spectrum.
        spectra: One-sided spectra (rad^2/Hz) of all axes together, by the source that has one, shape (frequencies,);
            nan beyond the frequencies that it has.
        lines_hz: Frequencies of the periodic sources (Hz), by their names.
    """

    judged: tuple[Judged, ...]
    freq_hz: Floats
    spectra: Mapping[str, Floats]
    lines_hz: Mapping[str, float]


def of_mission(table: ErrorBudget, sources: Mapping[str, Source]) -> Stated:
    """What a mission's table asks for.

    Args:
        table: The table.
        sources: Where each value of the mission comes from, by its dotted key.

    Raises:
        ValueError: As `stated`.
    """
    required = {name: requirement_of(each) for name, each in table.requirements.items()}
    return stated(sources_of(table, sources), required, table)


def stated(
    sources: Sequence[ErrorSource], required: Mapping[str, Requirement], table: ErrorBudget | None = None
) -> Stated:
    """What some sources add under some requirements.

    Args:
        sources: The sources.
        required: The requirements, by their names.
        table: A mission's table, which has correlations and says whether the loop is a source.

    Raises:
        ValueError: As `Requirement`, `contributions` and `correlated`.
    """
    correlations = correlations_of(table)
    added = {
        name: correlated(contributions(sources, each), sources, each, correlations) for name, each in required.items()
    }
    return Stated(tuple(sources), dict(required), added, table is not None and table.with_loop)


def judge(asked: Stated, closed: ClosedLoop | None) -> PointingErrorBudget:
    """The budget: totals, what each source means for them, how errors are distributed, and spectra.

    Args:
        asked: What is asked for.
        closed: The mission's loop under its controller; None where it is no source.

    Raises:
        ValueError: As `windowed` of a loop.
    """
    loop = closed if asked.with_loop else None
    judged = tuple(_judged(name, asked, loop) for name in asked.required)
    lines = {each.name: each.freq_hz for each in asked.sources if each.freq_hz is not None}
    freq = _frequencies(asked, loop, lines)
    return PointingErrorBudget(judged, freq, dict(_spectra(asked.sources, loop, freq)) if freq.size else {}, lines)


def _judged(name: str, asked: Stated, loop: ClosedLoop | None) -> Judged:
    required = asked.required[name]
    own = () if loop is None else loop_contributions(loop, required)
    found = total([*asked.added[name], *own], required)
    size = np.linspace(0.0, _BEYOND * max(found.quantile_rad, required.limit_rad or 0.0), _SIZES)
    return Judged(name, found, shares(found), size, beyond(found, size))


def _frequencies(asked: Stated, loop: ClosedLoop | None, lines: Mapping[str, float]) -> Floats:
    """From well below what is slowest to well above what is fastest; up to half the control rate where a loop is."""
    moving = [each.process for each in asked.sources if each.process is not None]
    if not moving and loop is None:
        return np.zeros(0)
    corners = [float(abs(rate)) / (2.0 * math.pi) for each in moving for rate in np.linalg.eigvals(each.A)]
    times = [time for each in asked.required.values() for time in (each.index.window_s, each.index.spacing_s) if time]
    turns = [*corners, *lines.values(), *(1.0 / time for time in times)]
    half = [] if loop is None else [0.5 / loop.open.loop.timing.period_s]
    high = max([*half, *(_AROUND * each for each in turns)])
    low = min([*(each / _AROUND for each in turns), *(each / 1e4 for each in half)])
    return np.geomspace(low, high, _BINS)


def _spectra(sources: Sequence[ErrorSource], loop: ClosedLoop | None, freq: Floats) -> Iterator[tuple[str, Floats]]:
    for each in sources:
        if each.process is not None:
            gain = np.array([np.sum(np.abs(each.response(f)) ** 2) for f in freq.tolist()])
            yield each.name, each.size.worst**2 * gain * psd(each.process, freq)
    if loop is not None and loop.open.loop.optical.every == 1:
        held = freq < 0.5 / loop.open.loop.timing.period_s
        density = np.full(freq.shape, np.nan)
        density[held] = residual_spectrum(loop, freq[held]).sum(axis=1)
        yield f"left by the loop under {loop.controller.name}", density
