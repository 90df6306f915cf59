"""What `microrad pointing --worst-case` does: a loop over what the identification leaves open of its mirror."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

from microrad.cli.frame import MET, UNMET, Outcome, json_text, progress_bar, refusal_of, width

if TYPE_CHECKING:
    from microrad.loop.disturbance.windows import ErrorIndex
    from microrad.mission.file import MissionFile
    from microrad.mission.tables.coupled_mirror import CoupledMirror


def worst_case_of(
    mission: "MissionFile",
    several: "CoupledMirror | None",
    controller: str,
    indices: "Sequence[ErrorIndex]",
    as_json: bool,
) -> Outcome:
    """Design one controller and look for the worst mirror that the identification leaves possible.

    Args:
        mission: The mission.
        several: The table of its loop's mirror of several axes, if it has one.
        controller: Name of the controller.
        indices: What counts of the error.
        as_json: Whether the text is to be JSON.
    """
    from microrad import mirror as mirror_room
    from microrad.link import tracking_light_w
    from microrad.loop import controller_study, coupled_study, worst_case
    from microrad.mirror import coupled
    from microrad.report.fine_pointing.worst_case import worst_case_data, worst_case_text

    with progress_bar() as progress, refusal_of(mission.path):
        light = tracking_light_w(mission)
        if several is None:
            known = worst_case.of_table(mission.mission.mirror)
            scene = controller_study.scene(mission, mirror_room.of(mission.mission), light)
            (made,) = controller_study.design(scene, progress, [controller])
            subject, seed = worst_case.of_scene(scene, known, made), scene.table.seed
        else:
            plant = coupled.of(several)
            known = worst_case.of_several_axes(plant)
            whole = coupled_study.scene(mission, plant, light)
            (both,) = coupled_study.design(whole, progress, [controller]).made
            subject, seed = worst_case.of_coupled_scene(whole, known, both), whole.table.seed
        found = worst_case.worst_case(subject, seed, indices, on_progress=progress)
    code = UNMET if found.unstable_draws or found.unstable_corners else MET
    if as_json:
        return Outcome(json_text({"mission_sha256": mission.sha256, **worst_case_data(found)}), code)
    return Outcome(worst_case_text(found, width()), code)
