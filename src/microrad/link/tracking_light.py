"""The light on the sensor of the fine-pointing loop."""

from microrad.link.budget.assembly import Shared
from microrad.link.budget.lines import beam_budget
from microrad.mission.file import MissionFile


def tracking_light_w(file: MissionFile) -> float | None:
    """Power (W) on the tracking sensor of `[fine_pointing]`, of which its noise follows.

    As its quad cell states it, else that of the answer's budget. None where the noise is given or there is no loop.
    """
    f = file.mission.fine_pointing
    cell = None if f is None else f.optical_sensor.quad_cell
    if cell is None:
        return None
    if cell.received_power_w is not None:
        return cell.received_power_w
    return beam_budget("answer", Shared.of(file.mission), file.mission.answer, file.sources).received_power_w
