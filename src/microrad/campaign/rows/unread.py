"""Drawn keys that no output of a campaign reads: they would change nothing, and nothing would say so."""

from collections.abc import Iterable, Iterator, Mapping
from typing import Any, cast

import numpy as np

from microrad.campaign.definition.keys import MIRROR, touches_loop
from microrad.campaign.definition.records import CampaignFile
from microrad.campaign.rows import evaluate, loops
from microrad.core import reads
from microrad.loop.fine_loop import ensemble
from microrad.mission.fields import Table
from microrad.mission.file import LinkFile


def unread(campaign: CampaignFile, rows: Iterable[LinkFile]) -> Iterator[str]:
    """The drawn keys that are read in none of these rows, one of each cell."""
    left = [draw.key for draw in campaign.draws if draw.key != MIRROR]
    for file in rows:
        if not left:
            return
        try:
            m, of_loop, of_outputs = file.mission, _of_loop(campaign, file), _of_outputs(campaign, file)
        except ValueError:
            return  # a row that fails does not tell what the others read
        left = [
            key
            for key in left
            if not _is_read(of_outputs, _path(m, key))
            and not (touches_loop(key, m) and _is_read(of_loop, _path(m, key)))
        ]
    yield from left


def _of_loop(campaign: CampaignFile, file: LinkFile) -> reads.Reads:
    """What making the loop of a row reads; nothing in a campaign without one."""
    table = campaign.table.loop
    if table is None:
        return reads.Reads()
    return reads.watched_call(lambda f: (loops.row_loop(f, table), loops.span(campaign, f)), file)[1]


def _of_outputs(campaign: CampaignFile, file: LinkFile) -> reads.Reads:
    """What the outputs of a row read, but for its runs."""
    names = [output.name for output in campaign.outputs]
    runs = None if campaign.table.loop is None else cast("ensemble.Ensemble", _Runs())
    return reads.watched_call(lambda f: evaluate.outputs(f, runs, names), file)[1]


class _Runs:
    """Runs of any loop, to see what is read of the mission beside them."""

    radial_rms_rad = 1e-6
    largest_rad = np.array([1e-6])

    def quantile_rad(self, probability: float) -> float:
        """Some error."""
        return 1e-6 * probability

    def beyond(self, radius_rad: float) -> float:
        """Some share of the time."""
        return float(radius_rad < 0.0)

    def share(self, counter: int) -> float:
        """Some share of the samples."""
        return float(counter < 0)


def _is_read(seen: reads.Reads, path: reads.Path) -> bool:
    """Whether a value was read, or a record as a whole that it stands in; so it is where that cannot be known."""
    if not seen.known or path in seen.digests:
        return True
    return any((*path[:end], reads.WHOLE) in seen.digests for end in range(len(path)))


def _path(m: Table, key: str) -> reads.Path:
    """Where `reads` has a key of the mission of the file that it watches."""
    path: tuple[Any, ...] = (0, "mission")
    inside: object = m
    for name in key.split("."):
        if isinstance(inside, Table):
            field = next(f for f, info in type(inside).model_fields.items() if (info.alias or f) == name)
            inside, path = getattr(inside, field), (*path, field)
        elif isinstance(inside, Mapping):
            inside, path = inside[name], (*path, (reads.KEY, name))
        # else: an item of a list, which is read as a whole
    return path
