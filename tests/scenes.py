"""The parts of a mission's loops, as a study assembles them."""

from microrad import mirror
from microrad.link import arrival_of, tracking_light_w
from microrad.loop import controller_study, paper_cases


def scene_of(file):
    """The fine-pointing loop of a mission file."""
    return controller_study.scene(file, mirror.of(file.mission), tracking_light_w(file), arrival_of(file))


def cases_of(mission):
    """The loop of `[control]` and the paper's sines."""
    return paper_cases.of(mission, mirror.of(mission))
