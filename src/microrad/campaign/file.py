"""The door to a campaign file: it is read, and a row in the middle of what it draws is tried."""

from pathlib import Path

import numpy as np

from microrad.campaign.definition.reader import read_definition
from microrad.campaign.definition.records import CampaignFile
from microrad.campaign.records import CampaignError
from microrad.campaign.rows.missions import MissionBuilder
from microrad.campaign.rows.unread import unread
from microrad.mission.file import LinkFile
from microrad.mission.toml import Document, MissionError


def load_campaign(path: Path) -> CampaignFile:
    """Read a campaign file and the mission that it draws from.

    Raises `MissionError` with every fault of the campaign file, of the mission under its [set] and in the cells of its
    grid; or with what is drawn in vain: without a mission in the middle, or without an effect on what is kept.
    """
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
    for key in unread(campaign, missions):
        reason = f"is read by nothing that is kept ({', '.join(campaign.keep)}): it would change no number"
        expected = "a key that they depend on, or another output in `keep`"
        if key == "communication.pointing_error" and campaign.table.loop is None and m.jitter is not None:
            expected = "jitter.bias or jitter.rms: under the table [jitter] the margin is that of requirement.outage"
        document.fault(f"inputs.{key}", "", reason, expected)
