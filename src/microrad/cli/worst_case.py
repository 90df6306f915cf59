"""`microrad worst-case`: a loop over what the identification leaves open of its mirror."""

from pathlib import Path
from typing import Annotated

import typer

from microrad.cli.frame import (
    MET,
    UNMET,
    Json,
    Outcome,
    Refusal,
    app,
    command,
    examples,
    json_text,
    option,
    progress_bar,
    refusal_of,
    width,
)
from microrad.cli.windows import indices_of, time_option


@app.command(
    name="worst-case",
    epilog=examples(
        "microrad worst-case leo-geo.toml --mirror lab-mirror.toml",
        "microrad worst-case leo-geo.toml --mirror two-axes.toml --window '10 ms' --controller LQG --json",
    ),
)
@command
def worst_case(
    file: Annotated[Path, typer.Argument(help="Mission file with a table [fine_pointing].", metavar="FILE")],
    mirror: Annotated[Path | None, option("--mirror", "FILE", "Mirror file in place of the mission's mirror.")] = None,
    window: Annotated[list[float] | None, time_option("--window", "Length of a window;")] = None,
    spacing: Annotated[
        list[float] | None, time_option("--spacing", "From the begin of a window to that of another;")
    ] = None,
    controller: Annotated[str, option("--controller", "NAME", "One that microrad design lists.")] = "PI",
    as_json: Json = False,
) -> Outcome:
    """Look for the worst mirror that an identification leaves possible.

    One controller is designed and kept. The command prints how far its pointing errors and its modulus margin go on
    drawn mirrors and on the corners of the parameters that matter most, and simulates the one with the smallest margin.
    The exit code is 1 when the loop is unstable on one of them.
    """
    if spacing and not window:
        raise Refusal("--spacing is between windows: give --window, their length, too.")
    from microrad import mirror as mirror_room
    from microrad.link import arrival_of, tracking_light_w
    from microrad.loop import controller_study, coupled_study
    from microrad.loop import worst_case as search
    from microrad.mirror import coupled
    from microrad.mission.file import load_loop
    from microrad.report.fine_pointing.worst_case import worst_case_data, worst_case_text

    mission, several = load_loop(file, mirror)
    with progress_bar() as progress, refusal_of(mission.path):
        indices = indices_of(window or [], spacing or [])
        light = tracking_light_w(mission), arrival_of(mission)
        if several is None:
            known = search.of_table(mission.mission.mirror)
            scene = controller_study.scene(mission, mirror_room.of(mission.mission), *light)
            (made,) = controller_study.design(scene, progress, [controller])
            subject, seed = search.of_scene(scene, known, made), scene.table.seed
        else:
            plant = coupled.of(several)
            known = search.of_several_axes(plant)
            whole = coupled_study.scene(mission, plant, *light)
            (both,) = coupled_study.design(whole, progress, [controller]).made
            subject, seed = search.of_coupled_scene(whole, known, both), whole.table.seed
        found = search.worst_case(subject, seed, indices, on_progress=progress)
    code = UNMET if found.unstable_draws or found.unstable_corners else MET
    if as_json:
        return Outcome(json_text({"mission_sha256": mission.sha256, **worst_case_data(found)}), code)
    return Outcome(worst_case_text(found, width()), code)
