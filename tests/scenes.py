"""The parts of a mission's loops, as a study assembles them."""

from microrad import mirror
from microrad.link import tracking_light_w
from microrad.loop import fine_pointing, paper_cases


def scene_of(file):
    """The fine-pointing loop of a mission file."""
    return fine_pointing.scene(file, mirror.of(file.mission), tracking_light_w(file))


def cases_of(mission):
    """The loop of `[control]` and the paper's sines."""
    return paper_cases.of(mission, mirror.of(mission))
