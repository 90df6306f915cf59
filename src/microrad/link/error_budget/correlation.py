"""Sources of a budget that are correlated: what they add together, in place of what each adds by itself."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from microrad.core.arrays import Floats
from microrad.core.lti import StateSpace
from microrad.link.error_budget.contributions import Contribution
from microrad.link.error_budget.distributions import case
from microrad.link.error_budget.sources import ErrorSource

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
    found: Sequence[Contribution], sources: Sequence[ErrorSource], correlations: Sequence[Correlation]
) -> tuple[Contribution, ...]:
    """Contributions in which those of correlated sources have become one; it has both names.

    Where nothing of them is spread, as of constants on the worst satellite, they stay as they are.

    Args:
        found: What each source adds to an index, in the order of the sources.
        sources: The sources.
        correlations: Which of them are correlated; all others are not.

    Raises:
        ValueError: For a source that is not there, or cannot be correlated, for a coefficient beyond 1, and for
            coefficients that no errors can have together: their matrix has a negative eigenvalue.
    """
    by_name = {source.name: source for source in sources}
    for each in correlations:
        _check(each, by_name)
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
        merged = _merged(merged, [names[place] for place in group], matrix[np.ix_(group, group)], by_name)
    return tuple(merged)


def _check(each: Correlation, by_name: dict[str, ErrorSource]) -> None:
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
    found: list[Contribution], names: list[str], matrix: Floats, by_name: dict[str, ErrorSource]
) -> list[Contribution]:
    chosen = [each for each in found if each.name in names]
    spread = np.array([_deviation(each, by_name[each.name]) for each in chosen])
    if not spread.any():
        return found
    order = [names.index(each.name) for each in chosen]
    together = np.einsum("ij,ia,jb->ab", matrix[np.ix_(order, order)], spread, spread)
    if by_name[names[0]].apart:
        together = np.diag(np.diag(together))
    mean = np.sum([part.whole_mean for each in chosen for part in each.parts], axis=0)
    whole = replace(
        chosen[0],
        name=" with ".join(each.name for each in chosen),
        parts=(case(len(mean), mean=mean, covariance=together),),
    )
    return [whole if each is chosen[0] else each for each in found if each is chosen[0] or each not in chosen]


def _deviation(of: Contribution, source: ErrorSource) -> Floats:
    """Standard deviation about each axis with the sign of its gain (rad), shape (axes,)."""
    variance = np.sum([np.diag(part.whole_covariance) for part in of.parts], axis=0)
    return np.asarray(np.sign(np.asarray(source.transfer)) * np.sqrt(variance))
