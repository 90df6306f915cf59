"""Mirrors that an identification leaves possible: drawn from the covariance that its mirror file gives."""

from collections import Counter
from collections.abc import Callable, Iterator
from itertools import chain, islice

import numpy as np
from pydantic.fields import FieldInfo

from microrad.core import lti
from microrad.core.arrays import Floats
from microrad.core.units import UnitError
from microrad.mission.fields import ProblemsError, Quantity, Table, rule_of_field
from microrad.mission.tables.mirror import Mirror, Place, Uncertainty, place

TRIES = 10_000
"""Times that one mirror is drawn again before its uncertainty is taken for one that no mirror has."""


def draws(table: Mirror, count: int, seed: int) -> tuple[Mirror, ...]:
    """Draw mirrors from the normal distribution that the table's `uncertainty` describes.

    A draw in which a value would change its sign, or that the table's own checks would refuse in a file, is drawn
    again: the distribution is cut off there. Each has a Philox stream of its own, so the first ones are the same for a
    larger count. What is drawn is a mirror and no estimate: it has no `uncertainty`.

    Args:
        table: The identified mirror.
        count: How many mirrors are drawn.
        seed: Seed of the random numbers.

    Raises:
        ValueError: Without an `uncertainty`, and where `TRIES` draws in a row are no mirror.
    """
    return tuple(mirror for mirror, _ in drawn(table, count, seed))


def drawn(table: Mirror, count: int, seed: int) -> tuple[tuple[Mirror, Floats], ...]:
    """The mirrors of `draws`, each with the factors of its parameters, shape (parameters,).

    Args:
        table: The identified mirror.
        count: How many mirrors are drawn.
        seed: Seed of the random numbers.

    Raises:
        ValueError: As `draws`.
    """
    uncertainty = _uncertainty(table)
    places = [place(table, key) for key in uncertainty.parameters]
    root = lti.covariance_root(relative_covariance(table))
    streams = (np.random.SeedSequence(seed, spawn_key=(index,)) for index in range(count))
    return tuple(_drawn(table, places, root, np.random.Generator(np.random.Philox(stream))) for stream in streams)


def moved(table: Mirror, factors: Floats) -> Mirror | None:
    """The mirror with its parameters multiplied; None where a file with it would be refused, or a value turned.

    Args:
        table: The identified mirror.
        factors: Factors of its uncertain parameters, shape (parameters,).

    Raises:
        ValueError: Without an `uncertainty`.
    """
    if any(_turned(table, factors)):
        return None
    places = [place(table, key) for key in _uncertainty(table).parameters]
    found = _moved(table, places, factors)
    return None if any(_faults(found, places)) else found


def parameters(table: Mirror, normals: Floats, again: Callable[[int], Iterator[Floats]]) -> Floats:
    """Values of the n uncertain parameters, shape (count, n) and in SI units: one mirror a row.

    Of a list that scales together the value is the factor of its items.

    Args:
        table: The identified mirror.
        normals: Standard normal numbers, shape (count, n), one row for each mirror.
        again: Given the number of a row that is no mirror, yields other standard normal numbers, shape (n,), to draw it
            from again.

    Raises:
        ValueError: Without an `uncertainty`, and where `TRIES` draws in a row are no mirror.
    """
    keys = _uncertainty(table).parameters
    places = [place(table, key) for key in keys]
    root = lti.covariance_root(relative_covariance(table))
    scale = np.array(
        [1.0 if _scales_a_list(table, at) else _first(table, key) for key, at in zip(keys, places, strict=True)]
    )
    accepted = (_accepted(table, places, root, chain((row,), again(i))) for i, row in enumerate(normals))
    factors = [factors for _, factors in accepted]
    return np.asarray(np.array(factors).reshape(normals.shape) * scale)


def parameter_units(table: Mirror) -> dict[str, str]:
    """SI units of what `parameters` draws, by key; "" for plain numbers and for the factor of a whole list.

    Raises:
        ValueError: Without an `uncertainty`.
    """
    return {key: _unit(table, place(table, key)) for key in _uncertainty(table).parameters}


def _unit(table: Mirror, at: Place) -> str:
    rule = rule_of_field(type(getattr(table, at.table)).model_fields[at.field])
    if rule is None or _scales_a_list(table, at):
        return ""
    return rule.unit if isinstance(rule, Quantity) else rule.each.unit


def values(table: Mirror) -> Floats:
    """Values of the uncertain parameters in SI units, shape (parameters,); of a list that scales together its first.

    Raises:
        ValueError: Without an `uncertainty`.
    """
    return np.array([_first(table, key) for key in _uncertainty(table).parameters])


def relative_covariance(table: Mirror) -> Floats:
    """Covariance (n, n) of the factors, 1 on average, that a draw multiplies the n parameters with.

    A correlation matrix that rounding left indefinite is repaired: eigenvalues below 0 become 0.

    Raises:
        ValueError: Without an `uncertainty`.
    """
    uncertainty = _uncertainty(table)
    sizes, vectors = np.linalg.eigh(np.array(uncertainty.correlation_rows))
    repaired = (vectors * np.maximum(sizes, 0.0)) @ vectors.T
    # the correlation is that of the values, the covariance that of their factors: a negative value turns the sign
    errors = np.array(uncertainty.standard_errors) * np.sign(values(table))
    errors /= np.sqrt(np.diag(repaired))
    return np.asarray(errors[:, None] * repaired * errors)


def relative_spread(table: Mirror) -> float:
    """Relative standard error of the slow gain (see `hysteresis.slow_gain`), to first order.

    Raises:
        ValueError: Without an `uncertainty`.
    """
    shares = np.array([_share_of_gain(table, place(table, key)) for key in _uncertainty(table).parameters])
    return float(np.sqrt(shares @ relative_covariance(table) @ shares))


def nothing_known(name: str) -> ValueError:
    """The refusal to draw mirrors from a file that says nothing of its uncertainty.

    Args:
        name: The mirror's name.
    """
    return ValueError(
        f'the mirror "{name}" has no table uncertainty, so nothing can be drawn; `microrad identify` writes one into '
        "its mirror file"
    )


def _uncertainty(table: Mirror) -> Uncertainty:
    if table.uncertainty is None:
        raise nothing_known(table.name)
    return table.uncertainty


def _values(table: Mirror, at: Place) -> tuple[float, ...]:
    """The value at a place, or all items of its list."""
    value = getattr(getattr(table, at.table), at.field)
    return value if isinstance(value, tuple) else (value,)


def _scales_a_list(table: Mirror, at: Place) -> bool:
    return at.item is None and isinstance(getattr(getattr(table, at.table), at.field), tuple)


def _first(table: Mirror, key: str) -> float:
    """The value of a parameter; of a list that scales together the first that is not 0."""
    at = place(table, key)
    values = _values(table, at)
    return next(v for v in values if v) if at.item is None else values[at.item]


def _share_of_gain(table: Mirror, at: Place) -> float:
    """Relative change of the slow gain over that of a parameter."""
    if at[:2] == ("bouc_wen", "d1_rad_v"):
        return 1.0
    if at[:2] != ("prandtl_ishlinskii", "weights_rad_v"):
        return 0.0
    weights = _values(table, at)
    return 1.0 if at.item is None else weights[at.item] / sum(weights)


# -------------------------------------------------------------------------------------------------------------- drawing
def _drawn(table: Mirror, places: list[Place], root: Floats, rng: np.random.Generator) -> tuple[Mirror, Floats]:
    normals = (rng.standard_normal(len(places)) for _ in range(TRIES))
    return _accepted(table, places, root, normals)


def _accepted(table: Mirror, places: list[Place], root: Floats, normals: Iterator[Floats]) -> tuple[Mirror, Floats]:
    """The first mirror among the draws from standard normal numbers, and the factors of its parameters."""
    refused: Counter[str] = Counter()
    why: dict[str, str] = {}
    for row in islice(normals, TRIES):
        factors = 1.0 + root @ row
        faults = dict(_turned(table, factors))
        if not faults:
            moved = _moved(table, places, factors)
            faults = dict(_faults(moved, places))
            if not faults:
                return moved, factors
        refused.update(faults.keys())
        why = faults | why
    key, times = refused.most_common(1)[0]
    raise ValueError(
        f'the uncertainty of the mirror "{table.name}" leaves no mirror: none of {TRIES} draws is one, {times} times '
        f"because {key} {why[key]}; give smaller standard errors, or leave such a parameter out"
    )


def _moved(table: Mirror, places: list[Place], factors: Floats) -> Mirror:
    """The mirror with its parameters multiplied, unchecked."""
    values: dict[tuple[str, str], list[float]] = {}
    for at, factor in zip(places, factors.tolist(), strict=True):
        items = values.setdefault(at[:2], list(_values(table, at)))
        for i in range(len(items)) if at.item is None else (at.item,):
            items[i] *= factor
    updates: dict[str, Table] = {}
    for (name, field), items in values.items():
        part = updates.get(name, getattr(table, name))
        several = isinstance(getattr(part, field), tuple)
        updates[name] = part.model_copy(update={field: tuple(items) if several else items[0]})
    return table.model_copy(update={**updates, "uncertainty": None})


def _turned(table: Mirror, factors: Floats) -> Iterator[tuple[str, str]]:
    """Keys of values that would change their sign."""
    keys = _uncertainty(table).parameters
    return ((key, "would change its sign") for key, factor in zip(keys, factors, strict=True) if factor <= 0.0)


def _faults(moved: Mirror, places: list[Place]) -> Iterator[tuple[str, str]]:
    """What the checks of a mirror file would say of the tables that moved: key and reason."""
    for name in dict.fromkeys(at.table for at in places):
        part, changed = getattr(moved, name), {at.field for at in places if at.table == name}
        for field, info in type(part).model_fields.items():
            if field in changed:
                yield from ((f"{name}.{info.alias or field}", why) for why in _out_of_range(getattr(part, field), info))
        yield from ((f"{name}.{problem.key}".rstrip("."), problem.reason) for problem in part.problems())


def _out_of_range(value: float | tuple[float, ...] | None, info: FieldInfo) -> Iterator[str]:
    """Why a value, written into a file, would be refused."""
    rule = rule_of_field(info)
    if value is None or rule is None:
        return
    unit = rule.unit if isinstance(rule, Quantity) else rule.each.unit
    items = [f"{v!r} {unit}" if unit else v for v in (value if isinstance(value, tuple) else (value,))]
    try:
        rule.read(items[0] if isinstance(rule, Quantity) else items)
    except UnitError as error:
        yield error.reason
    except ProblemsError as error:
        yield from (problem.reason for problem in error.problems)
