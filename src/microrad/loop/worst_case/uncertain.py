"""Mirrors that an identification leaves possible, of one axis or several alike: drawn, or moved on purpose."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from microrad.core import lti
from microrad.core.arrays import Floats
from microrad.mirror import Mirror, coupled, from_table, spread
from microrad.mirror.coupled import CoupledMirror
from microrad.mission.tables import mirror as mirror_table

LEAST_FACTOR = 0.1
"""Least factor of a parameter that is moved on purpose: no corner turns a value's sign."""


class Moved(NamedTuple):
    """A mirror, and where its parameters are: off their values, in standard errors, shape (parameters,)."""

    mirror: Mirror
    sigmas: Floats


@dataclass(frozen=True, slots=True, eq=False)
class Uncertain:
    """What is known of a mirror's parameters.

    ``rows`` (parameters, directions) is the root of their correlation: a mirror is moved by standard normal numbers
    along independent directions, and its parameters by rows @ those numbers in their standard errors. ``drawn`` gives
    so many mirrors by a seed, and ``moved`` one by its numbers, or None where that is no mirror.
    """

    parameters: tuple[str, ...]
    rows: Floats
    drawn: Callable[[int, int], list[Moved]]
    moved: Callable[[Floats], Moved | None]


def of_table(table: mirror_table.Mirror) -> Uncertain:
    """What a mirror file of one axis says.

    Raises:
        ValueError: It has no table `uncertainty`.
    """
    root = lti.covariance_root(spread.relative_covariance(table))
    assert table.uncertainty is not None  # else the line above has refused it
    errors = np.array(table.uncertainty.standard_errors)
    signs = np.sign(spread.values(table))
    scale = np.where(errors > 0.0, signs / np.where(errors > 0.0, errors, 1.0), 0.0)

    def at(of: mirror_table.Mirror, factors: Floats) -> Moved:
        return Moved(from_table(of), scale * (factors - 1.0))

    def drawn(count: int, seed: int) -> list[Moved]:
        return [at(*each) for each in spread.drawn(table, count, seed)]

    def moved(normals: Floats) -> Moved | None:
        factors = np.maximum(1.0 + root @ normals, LEAST_FACTOR)
        found = spread.moved(table, factors)
        return None if found is None else at(found, factors)

    return Uncertain(table.uncertainty.parameters, scale[:, None] * root, drawn, moved)


def of_several_axes(mirror: CoupledMirror) -> Uncertain:
    """What a mirror file of several axes says.

    Raises:
        ValueError: It has no table `uncertainty`.
    """
    if mirror.known is None:
        raise spread.nothing_known(mirror.mirror.name)
    rows = mirror.known.factor

    def drawn(count: int, seed: int) -> list[Moved]:
        return [Moved(each.mirror, rows @ normals) for each, normals in coupled.drawn(mirror, count, seed)]

    def moved(normals: Floats) -> Moved | None:
        found = coupled.moved(mirror, normals)
        return Moved(found.mirror, rows @ normals) if coupled.is_one(found) else None

    return Uncertain(mirror.known.parameters, rows, drawn, moved)
