"""Mirrors of several axes that an identification leaves possible: drawn from the covariance that its file gives."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from itertools import chain, islice
from typing import Any

import numpy as np

from microrad.core import lti
from microrad.core.arrays import Floats
from microrad.mirror.coupled.records import CoupledMirror, Known, modes
from microrad.mirror.hysteresis import BoucWen, PrandtlIshlinskii, rest_gain, slow_gain
from microrad.mirror.spread import nothing_known
from microrad.mission.tables.mirror import least_alpha_1_v

TRIES = 1000
"""Times that one mirror is drawn again before its uncertainty is taken for one that no mirror has."""

LEAST_DECAY = 0.1
"""Least decay of a drawn mode, in its own."""

_FIELDS = {
    **{"thresholds": "thresholds_v", "weights": "weights_rad_v", "widening": "widening_s"},
    **{"polynomial": "polynomial_rad", "d1": "d1_rad_v", "d2": "d2_s_v", "epsilon": "epsilon_rad_v"},
    **{"delta": "delta_s_v", "alpha": "alpha_1_v", "beta": "beta_1_v", "gamma": "gamma_1_v"},
    **{"eta": "eta_1_v", "exponent": "exponent"},
}
"""Fields of the hysteresis models by their keys in a mirror file."""


def draws(mirror: CoupledMirror, count: int, seed: int) -> tuple[CoupledMirror, ...]:
    """Draw mirrors from the normal distribution that ``known`` describes; none without one.

    A decay stays above a tenth of its own, and what is at least 0 in the mirror stays at least 0: the distribution is
    cut off there. A mirror that runs away at rest or where all plays slide, whose thresholds change places, or whose
    Bouc-Wen model grows without bound, is drawn again. Each has a Philox stream of its own, so the first ones are the
    same for a larger count.

    Args:
        mirror: The identified mirror.
        count: How many mirrors are drawn.
        seed: Seed of the random numbers.

    Raises:
        ValueError: Where `TRIES` draws in a row are no mirror.
    """
    return tuple(each for each, _ in drawn(mirror, count, seed)) if mirror.known is not None else ()


def drawn(mirror: CoupledMirror, count: int, seed: int) -> tuple[tuple[CoupledMirror, Floats], ...]:
    """The mirrors of `draws`, each with the standard normal numbers that it is made of, shape (`directions`,).

    Args:
        mirror: The identified mirror.
        count: How many mirrors are drawn.
        seed: Seed of the random numbers.

    Raises:
        ValueError: Nothing is known of the mirror, or `TRIES` draws in a row are no mirror.
    """
    known = _known(mirror)
    streams = (np.random.SeedSequence(seed, spawn_key=(index,)) for index in range(count))
    return tuple(_first(mirror, _normals(stream, known)) for stream in streams)


def directions(mirror: CoupledMirror) -> int:
    """Number of independent directions that the mirror is known in: columns of the factor of its correlation.

    Raises:
        ValueError: Nothing is known of it.
    """
    return int(_known(mirror).factor.shape[1])


def accepted(mirror: CoupledMirror, normals: Floats, again: Callable[[int], Iterator[Floats]]) -> Floats:
    """Standard normal numbers of mirrors, shape (count, `directions`): those given, but where they are no mirror.

    Args:
        mirror: The identified mirror.
        normals: Standard normal numbers, shape (count, `directions`), one row for each mirror.
        again: Given the number of a row that is no mirror, yields other standard normal numbers to draw it from again.

    Raises:
        ValueError: Nothing is known of the mirror, or `TRIES` draws in a row are no mirror.
    """
    found = [_first(mirror, chain((row,), again(i)))[1] for i, row in enumerate(normals)]
    return np.array(found).reshape(normals.shape)


def moved(mirror: CoupledMirror, normals: Floats) -> CoupledMirror:
    """The mirror with its parameters moved by their standard errors times factor @ normals; an estimate no more.

    Args:
        mirror: The identified mirror.
        normals: Standard normal numbers, shape (`directions`,); with zeros the mirror stays as it is.

    Raises:
        ValueError: Nothing is known of the mirror.
    """
    known = _known(mirror)
    changes = known.standard_errors * (known.factor @ normals)
    return replace(changed(mirror, dict(zip(known.parameters, changes.tolist(), strict=True))), known=None)


def _known(mirror: CoupledMirror) -> Known:
    if mirror.known is None:
        raise nothing_known(mirror.mirror.name)
    return mirror.known


def _normals(stream: np.random.SeedSequence, known: Known) -> Iterator[Floats]:
    rng = np.random.Generator(np.random.Philox(stream))
    while True:
        yield rng.standard_normal((known.factor.shape[1],))


def _first(mirror: CoupledMirror, normals: Iterator[Floats]) -> tuple[CoupledMirror, Floats]:
    """The first mirror that is one, and the numbers that it is made of."""
    for row in islice(normals, TRIES):
        found = moved(mirror, row)
        if is_one(found):
            return found, row
    raise ValueError(
        f"{TRIES} draws from the uncertainty of {mirror.mirror.name!r} in a row run away, have thresholds out of order "
        "or hysteresis without bound: its standard errors are too large for a mirror; identify it from more records, "
        "or leave the table uncertainty out"
    )


def is_one(mirror: CoupledMirror) -> bool:
    """Whether thresholds ascend, hysteresis is bounded, and neither stuck nor sliding plays make the mirror grow."""
    own = mirror.mirror
    if any(np.any(np.diff(play.thresholds_v) <= 0.0) for play in own.plays):
        return False
    if not all(map(_is_bounded, own.bouc_wen)):
        return False
    ends = ([gain(model) for model in own.bank] for gain in (rest_gain, slow_gain))
    return all(lti.growth_1_s(own.A, own.E, own.F, np.array(gains)) < 0.0 for gains in ends) if own.A.size else True


def _is_bounded(model: BoucWen) -> bool:
    return model.exponent >= 1.0 and model.alpha_1_v > least_alpha_1_v(model.beta_1_v, model.gamma_1_v, model.eta_1_v)


def changed(mirror: CoupledMirror, by: Mapping[str, float]) -> CoupledMirror:
    """The mirror with some of its numbers changed.

    Args:
        mirror: The mirror.
        by: Changes by key as `Known` names them, in SI units; a decay grows where its change is above 0.
    """
    own = mirror.mirror
    roots = [list(root) for root in modes(own.A)]
    matrices: dict[str, Any] = {}
    elements: dict[int, BoucWen | PrandtlIshlinskii] = {}
    delay_s = mirror.delay_s
    for key, change in by.items():
        what, *rest = key.split(".")
        if what == "recording":
            delay_s = max(delay_s + change, 0.0)
        elif what == "modes":
            root = roots[int(rest[1]) - 1]
            if rest[0] == "decay":
                root[0] = min(root[0] - change, LEAST_DECAY * root[0])
            else:
                root[1] = float(np.copysign(max(abs(root[1]) + np.sign(root[1]) * change, 1e-9), root[1]))
        elif what == "matrices":
            matrix = matrices.setdefault(rest[0], getattr(own, rest[0]).copy())
            matrix[int(rest[1]) - 1, int(rest[2]) - 1] += change
        else:
            number = int(rest[0]) - 1
            elements[number] = _with(elements.get(number, own.bank[number]), _FIELDS[rest[1]], rest[2:], change)
    bank = [elements.get(number, model) for number, model in enumerate(own.bank)]
    made = replace(
        own,
        A=lti.modal_matrix([(s, w) for s, w in roots]),
        bouc_wen=tuple(model for model in bank if isinstance(model, BoucWen)),
        plays=tuple(model for model in bank if isinstance(model, PrandtlIshlinskii)),
        **matrices,
    )
    return replace(mirror, mirror=made, delay_s=delay_s)


def _with(
    model: BoucWen | PrandtlIshlinskii, field: str, item: list[str], change: float
) -> BoucWen | PrandtlIshlinskii:
    """The model with one of its numbers changed; one that is at least 0 stays so, but for signed ones."""
    value = getattr(model, field)
    values = list(value) if isinstance(value, tuple) else [value]
    place = int(item[0]) - 1 if item else 0
    bounded = field in ("thresholds_v", "weights_rad_v", "widening_s") and values[place] >= 0.0
    values[place] = max(values[place] + change, 0.0) if bounded else values[place] + change
    parts: dict[str, Any] = {field: tuple(values) if isinstance(value, tuple) else values[0]}
    return replace(model, **parts)
