"""The door to a campaign file: it is read, and a row in the middle of what it draws is tried.

A drawn key that no output of that row reads would change nothing, and nothing would say so: it is refused.
"""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, cast

import numpy as np

from microrad.campaign.definition.keys import MIRROR, touches_loop
from microrad.campaign.definition.reader import read_definition
from microrad.campaign.definition.records import CampaignFile
from microrad.campaign.records import CampaignError
from microrad.campaign.rows import evaluate
from microrad.campaign.rows.loops import mission_loop
from microrad.campaign.rows.missions import MissionBuilder
from microrad.core import kernels, reads
from microrad.loop.pointing_loop import ensemble
from microrad.mission.fields import Table
from microrad.mission.file import LinkFile
from microrad.mission.toml import Document, MissionError


def load_campaign(path: str | Path) -> CampaignFile:
    """Read a campaign file and the mission that it draws from.

    Raises `MissionError` with every fault of the campaign file, of the mission under its [set] and in the cells of its
    grid; or with what is drawn in vain: without a mission in the middle, or without an effect on what is kept.

    Example:
        ```python
        import microrad

        campaign = microrad.load_campaign("campaign.toml")
        print([draw.key for draw in campaign.draws], campaign.keep)
        ```
    """
    path = Path(path)
    campaign, document = read_definition(path)
    missions = _medians(campaign, document)
    if not document.faults:
        _refuse_unread(campaign, missions, document)
    if document.faults:
        raise MissionError(path, document.faults)
    return campaign


def _medians(campaign: CampaignFile, document: Document) -> list[LinkFile]:
    """The mission of each cell in the middle of all distributions, up to the first that is none, which is noted."""
    half = np.array([0.5])
    values = {d.key: float(d.distribution.at(half)[0]) for d in campaign.draws if d.distribution is not None}
    builder, found = MissionBuilder(campaign), []
    for number, cell in enumerate(campaign.cells):
        try:
            found.append(builder.mission(number, values))
        except CampaignError as error:
            where = f" of the cell {cell.label}" if cell.values else ""
            blamed = next((f".{draw.key}" for draw in campaign.draws if draw.key in str(error)), "")
            reason = f"leaves no mission in the middle of all distributions{where}: {error}"
            document.fault(f"inputs{blamed}", "", reason, "distributions about a mission that works")
            break
    return found


def _refuse_unread(campaign: CampaignFile, missions: list[LinkFile], document: Document) -> None:
    """Note the drawn keys that change nothing of what is kept."""
    m = campaign.mission.mission
    for key in _unread(campaign, missions):
        reason = f"is read by nothing that is kept ({', '.join(campaign.keep)}): it would change no number"
        expected = "a key that they depend on, or another output in `keep`"
        if key == "communication.pointing_error" and campaign.table.loop is None and m.jitter is not None:
            expected = "jitter.bias or jitter.rms: under the table [jitter] the margin is that of requirement.outage"
        document.fault(f"inputs.{key}", "", reason, expected)


# ----------------------------------------------------------------------------------------------------- what is read
def _unread(campaign: CampaignFile, missions: list[LinkFile]) -> Iterator[str]:
    """The drawn keys that are read in none of these missions, one of each cell."""
    table, outputs = campaign.table.loop, [output.name for output in campaign.outputs]
    runs = None if table is None else cast("ensemble.Ensemble", _Runs())
    left = [draw.key for draw in campaign.draws if draw.key != MIRROR]
    for file in missions:
        if not left:
            return
        try:
            by_outputs = reads.watched_call(lambda f: evaluate.outputs(f, runs, outputs), file)[1]
            by_loop = reads.Reads()
            if table is not None:
                by_loop = reads.watched_call(lambda f: mission_loop(f, table, campaign.table.seed), file)[1]
        except ValueError:
            return  # a row that fails does not tell what the others read
        paths = {key: _path(file.mission, key) for key in left}
        in_loop = {key for key in left if touches_loop(key, file.mission) and _is_read(by_loop, paths[key])}
        left = [key for key in left if key not in in_loop and not _is_read(by_outputs, paths[key])]
    yield from left


class _Runs:
    """Runs of any loop, to see what is read of the mission beside them."""

    radial_rms_rad = 1e-6
    largest_rad = np.array([1e-6])
    histogram = np.ones((1, kernels.BINS), dtype=np.int64)

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
