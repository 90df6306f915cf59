"""The random numbers of a campaign: any rows by themselves, the same bits whoever asks and in whatever order."""

from collections.abc import Iterator
from functools import lru_cache, partial

import numpy as np
from numpy.typing import NDArray

from microrad.campaign.definition.distributions import standard_normal
from microrad.campaign.definition.keys import MIRROR
from microrad.campaign.definition.records import CampaignFile
from microrad.core.arrays import Floats
from microrad.mirror import coupled
from microrad.mirror import spread as mirror_spread

INPUTS, AGAIN = 1, 2
"""Purposes of a Philox stream: second word of its key, behind the seed."""
_SOBOL_BITS = 30


def rows(campaign: CampaignFile, cell: int, first: int, count: int) -> tuple[dict[str, Floats], Floats]:
    """Drawn columns (count,) by key, in SI units, and the weights (count,), of consecutive rows of a cell.

    Weights are 1 but for inputs that are drawn from another distribution than their own: there the ratio of both
    densities, so that their mean is 1. All cells have the same random numbers.

    Args:
        campaign: what is drawn.
        cell: the cell, whose mirror's covariance is drawn from where that is an input.
        first: number of the first row.
        count: how many rows.
    """
    table, names = campaign.table, [each.key for each in campaign.inputs]
    points = uniform(table.sampling, table.seed, campaign.block, len(names), first, count)
    shares = dict(zip(names, points.T, strict=True))
    columns: dict[str, Floats] = {}
    log_weight = np.zeros(count)
    for draw in campaign.draws:
        if draw.distribution is None:
            columns |= _mirrors(campaign, cell, shares, first)
            continue
        columns[draw.key] = (draw.drawn_as or draw.distribution).at(shares[draw.key])
        if draw.drawn_as is not None:
            value = columns[draw.key]
            log_weight += draw.distribution.log_density(value) - draw.drawn_as.log_density(value)
    return {name: columns[name] for name in names}, np.exp(log_weight)


def _mirrors(campaign: CampaignFile, cell: int, shares: dict[str, Floats], first: int) -> dict[str, Floats]:
    """Parameters of mirrors that the identification leaves possible; nan for those that the cell's mirror has not.

    Of a mirror of several axes they are the standard normal numbers that move it.
    """
    own = campaign.cells[cell]
    table = own.mirror
    if own.several_axes is not None:
        keys, draw = own.directions, partial(coupled.accepted, own.several_axes)
    else:
        assert table is not None and table.uncertainty is not None  # the campaign file's own check
        keys = tuple(f"{MIRROR}.{key}" for key in table.uncertainty.parameters)
        draw = partial(mirror_spread.parameters, table)
    normals = standard_normal(np.column_stack([shares[key] for key in keys]))

    def again(row: int) -> Iterator[Floats]:
        stream = _philox(campaign.table.seed, AGAIN, (first + row) << 64)
        while True:
            yield standard_normal(_open_unit(stream.random_raw(len(keys))))

    values = draw(normals, again)
    drawn = {draw.key for draw in campaign.draws}
    missing = {name: np.full(len(normals), np.nan) for name in shares if name not in drawn}
    return missing | {key: values[:, i] for i, key in enumerate(keys)}


# --------------------------------------------------------------------------------------------------------- unit cube
def uniform(sampling: str, seed: int, block: int, dimensions: int, first: int, count: int) -> Floats:
    """Points (count, dimensions) inside the open unit cube: those of consecutive rows.

    "latin-hypercube" and "sobol" (scrambled, Owen 1995 in the form of Matousek 1998) fill the cube evenly by blocks of
    rows, a power of two; the blocks are independent replicates of each other.

    Args:
        sampling: "random", "latin-hypercube" or "sobol".
        seed: the campaign's.
        block: rows of one set, a power of two.
        dimensions: numbers of a row.
        first: number of the first row.
        count: how many rows.
    """
    if not dimensions or not count:
        return np.zeros((count, dimensions))
    if sampling == "random":
        return _random(seed, dimensions, first, count)
    numbers = range(first // block, (first + count - 1) // block + 1)
    parts = []
    for number in numbers:
        start = number * block
        parts.append(_block(sampling, seed, block, dimensions, number)[max(first - start, 0) : first + count - start])
    return np.concatenate(parts)


def _random(seed: int, dimensions: int, first: int, count: int) -> Floats:
    """By counter: each row has whole blocks of four words for itself."""
    words = -(-dimensions // 4)
    stream = _philox(seed, INPUTS, first * words)
    return _open_unit(stream.random_raw(count * 4 * words)).reshape(count, 4 * words)[:, :dimensions]


def _philox(seed: int, purpose: int, counter: int) -> np.random.Philox:
    return np.random.Philox(key=seed | purpose << 64, counter=counter)


def _open_unit(raw: NDArray[np.uint64]) -> Floats:
    """Words of 64 bits as numbers inside (0, 1)."""
    return np.asarray(((raw >> np.uint64(12)).astype(float) + 0.5) * 2.0**-52)


@lru_cache(maxsize=8)
def _block(sampling: str, seed: int, block: int, dimensions: int, number: int) -> Floats:
    """A replicate, from a stream of its own."""
    from scipy.stats import qmc

    stream = np.random.SeedSequence(seed, spawn_key=(INPUTS, number))
    rng = np.random.Generator(np.random.Philox(stream))
    if sampling == "sobol":
        sobol = qmc.Sobol(dimensions, scramble=True, bits=_SOBOL_BITS, rng=rng)
        points = sobol.random_base2(block.bit_length() - 1) + 0.5**_SOBOL_BITS / 2.0  # the middle of each cell: never 0
    else:
        points = qmc.LatinHypercube(dimensions, rng=rng).random(block)
        points = np.clip(points, 2.0**-54, 1.0 - 2.0**-53)
    points.flags.writeable = False
    return np.asarray(points)
