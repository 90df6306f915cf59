"""Sources of a budget that are correlated: what they add together, in place of what each adds by itself."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from microrad.core.arrays import Floats
from microrad.core.lti import StateSpace
from microrad.link.error_budget.contributions import Contribution, Requirement
from microrad.link.error_budget.distributions import case
from microrad.link.error_budget.sources import ErrorSource
from microrad.link.pointing.error_classes import WORST_SATELLITE_SIGMAS
from microrad.link.pointing.summation import sigma_multiple

_INDEFINITE = 1e-9  # how far below 0 rounding may leave an eigenvalue of the matrix


@dataclass(frozen=True, slots=True)
class Correlation:
    """How two sources go along with each other: both Gaussian, in time (random) or over the satellites (constant).

    Args:
        first: Name of a source.
        second: Name of another one of its class.
        coefficient: Coefficient of correlation, from -1 to 1; about each axis where the sources are apart by axis.
    """

    first: str
    second: str
    coefficient: float


def correlated(
    found: Sequence[Contribution],
    sources: Sequence[ErrorSource],
    required: Requirement,
    correlations: Sequence[Correlation],
) -> tuple[Contribution, ...]:
    """Contributions in which those of correlated sources have become one; it has the names of all.

    On the worst satellite correlated constants lie three of their common deviations out; at its worst time a correlated
    noise stands with as many of them as hold the confidence.

    Args:
        found: What each source adds to an index, in the order of the sources.
        sources: The sources.
        required: The index and over what it is taken.
        correlations: Which of them are correlated; all others are not.

    Raises:
        ValueError: For a source that is not there, or cannot be correlated, for a coefficient beyond 1, for a pair that
            is stated twice, for correlated constants of satellites at their worst time, and for coefficients that no
            errors can have together: their matrix has a negative eigenvalue.
    """
    by_name = {source.name: source for source in sources}
    for each in correlations:
        _check(each, by_name, required)
    pairs = [frozenset((each.first, each.second)) for each in correlations]
    if len(set(pairs)) < len(pairs):
        raise ValueError("two correlations are of the same sources; give each pair once")
    names = list(dict.fromkeys(name for each in correlations for name in (each.first, each.second)))
    matrix = np.eye(len(names))
    for each in correlations:
        pair = names.index(each.first), names.index(each.second)
        matrix[pair] = matrix[pair[::-1]] = each.coefficient
    least = float(np.min(np.linalg.eigvalsh(matrix), initial=0.0))
    if least < -_INDEFINITE:
        raise ValueError(
            f"correlations of {', '.join(names)}: their matrix has the eigenvalue {least:.3g}, so that no errors can "
            "be correlated so; give a positive semidefinite one"
        )
    merged = list(found)
    for group in _groups(matrix):
        merged = _merged(merged, [names[place] for place in group], matrix[np.ix_(group, group)], by_name, required)
    return tuple(merged)


def _check(each: Correlation, by_name: dict[str, ErrorSource], required: Requirement) -> None:
    both = [by_name.get(name) for name in (each.first, each.second)]
    where = f"correlation of {each.first} and {each.second}"
    if None in both or each.first == each.second:
        raise ValueError(f"{where}: name two sources out of {', '.join(by_name)}")
    if not -1.0 <= each.coefficient <= 1.0:
        raise ValueError(f"{where}: the coefficient is {each.coefficient:g}; give one from -1 to 1")
    kinds = {(source.kind, source.apart) for source in both if source is not None}
    fits = all(source is not None and _gaussian(source) for source in both)
    if len(kinds) > 1 or not fits:
        raise ValueError(
            f"{where}: only two Gaussian errors of one class, random or constant, that reach the axes by gains and "
            "alike have one; state the common cause as a source of its own"
        )

    constant = any(kind == "constant" for kind, _ in kinds)
    if constant and required.interpretation == "ensemble":
        raise ValueError(
            f"{where}: the sizes of correlated constants have no common distribution here; take the interpretation "
            "temporal or mixed"
        )


def _gaussian(source: ErrorSource) -> bool:
    if isinstance(source.transfer, StateSpace):
        return False
    in_time = source.kind == "random" and not source.even_in_time and source.size.shape == "fixed"
    return in_time or (source.kind == "constant" and source.size.shape == "gaussian")


def _groups(matrix: Floats) -> list[list[int]]:
    from scipy.sparse.csgraph import connected_components

    _, label = connected_components(matrix != 0.0, directed=False)
    groups = [np.flatnonzero(label == each).tolist() for each in range(int(np.max(label, initial=-1)) + 1)]
    return [group for group in groups if len(group) > 1]


def _merged(
    found: list[Contribution],
    names: list[str],
    matrix: Floats,
    by_name: dict[str, ErrorSource],
    required: Requirement,
) -> list[Contribution]:
    chosen = [each for each in found if each.name in names]
    sources = [by_name[each.name] for each in chosen]
    counts = required.index.takes in (("APE", "RPE") if sources[0].kind == "random" else ("APE", "MPE"))
    if not counts:
        return found
    order = [names.index(each.name) for each in chosen]
    spread = np.array([_deviation(source) * np.asarray(source.transfer, dtype=float) for source in sources])
    together = np.einsum("ij,ia,jb->ab", matrix[np.ix_(order, order)], spread, spread)
    if sources[0].apart:
        together = np.diag(np.diag(together))
    axes, sigma = sources[0].axes, np.sqrt(np.maximum(np.diag(together), 0.0))
    mean = np.sum([source.size.mean * np.asarray(source.transfer) for source in sources], axis=0)
    if sources[0].kind == "random":
        ends = required.interpretation == "ensemble"
        part = case(axes, mean=sigma_multiple(required.confidence) * sigma) if ends else case(axes, covariance=together)
    elif required.interpretation == "temporal":
        part = case(axes, mean=np.abs(mean) + WORST_SATELLITE_SIGMAS * sigma)
    else:
        part = case(axes, mean=mean, covariance=together)
    name, origin = " with ".join(each.name for each in chosen), "; ".join(each.origin for each in chosen)
    statistic = ", ".join(dict.fromkeys(each.statistic for each in chosen))
    whole = Contribution(name, chosen[0].kind, (part,), origin, statistic)
    return [whole if each is chosen[0] else each for each in found if each is chosen[0] or each not in chosen]


def _deviation(source: ErrorSource) -> float:
    return source.size.mean if source.kind == "random" else source.size.width
