"""Commands of the fine-pointing loop: controllers designed for a mission, with their margins and what they leave."""

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from microrad.cli.coupled_design import broken_promises, design_of_several_axes, tuned_text
from microrad.cli.error_budget import stated_beside
from microrad.cli.frame import (
    MET,
    UNMET,
    Accept,
    Json,
    Outcome,
    app,
    command,
    examples,
    json_text,
    option,
    progress_bar,
    refusal_of,
    width,
)
from microrad.cli.windows import indices_of_mission, time_option

if TYPE_CHECKING:
    from microrad.link.pointing.code_words import LostWords
    from microrad.link.pointing.coded_residual import CodedResidual
    from microrad.loop.controller_study import AnyScene, Design, Outlook, Scene
    from microrad.loop.disturbance.windows import ErrorIndex
    from microrad.loop.pointing_loop.loop import LoopController
    from microrad.loop.pointing_loop.simulated_windows import SimulatedErrors
    from microrad.mission.file import MissionFile


@app.command(
    epilog=examples(
        "microrad design leo-geo.toml",
        "microrad design leo-geo.toml --mirror lab-mirror.toml",
        "microrad design leo-geo.toml --mirror two-axes.toml",
        "microrad design leo-geo.toml --json > controllers.json",
    )
)
@command
def design(
    file: Annotated[Path, typer.Argument(help="Mission file with a table [fine_pointing].", metavar="FILE")],
    mirror: Annotated[Path | None, option("--mirror", "FILE", "Mirror file in place of the mission's mirror.")] = None,
    accept: Accept = False,
    as_json: Json = False,
) -> Outcome:
    """Design controllers for a mission's fine-pointing loop.

    Each is tuned for the mission's mirror, disturbances, noise and delay under its modulus margin, for one axis, in
    theory (linear), and shown with what it leaves there and, in a few runs, on the mirror with its hysteresis; microrad
    run simulates all of it. For a mirror file of several axes there is one controller of all axes, decoupled, and the
    margins are those of the whole. --json also prints their matrices. The exit code is 1 when one of them is refused:
    its simulated figure is more than 1.5 times its linear one.
    """
    from microrad import mirror as mirror_room
    from microrad.link import arrival_of, tracking_light_w
    from microrad.loop import controller_study
    from microrad.mirror.summary import unknown_dynamics
    from microrad.mission.file import load_loop

    mission, several = load_loop(file, mirror)
    if several is not None:
        return design_of_several_axes(mission, several, accept, as_json)
    with progress_bar() as progress, refusal_of(mission.path):
        light = tracking_light_w(mission), arrival_of(mission)
        scene = controller_study.scene(mission, mirror_room.of(mission.mission), *light)
        offered = controller_study.offered(scene.table, mission.mission.mirror)
        designs, left = zip(*controller_study.design_and_promise(scene, progress, offered), strict=True)
    marks = [each.mark(accept) for each in left]
    warnings = list(filter(None, [unknown_dynamics(mission.mission.mirror), _broken(designs, left, accept)]))
    code = UNMET if "refused" in marks else MET
    if as_json:
        controllers = list(map(_data, designs, left, marks))
        found = {"mission_sha256": mission.sha256, "controllers": controllers, "warnings": warnings}
        return Outcome(json_text(found), code)
    return Outcome(_text(scene, designs, left, marks, warnings), code)


@app.command(
    epilog=examples(
        "microrad pointing leo-geo.toml",
        "microrad pointing leo-geo.toml --window '1 ms' --window '10 s' --spacing '1 min'",
        "microrad pointing leo-geo.toml --controller LQG --json",
        "microrad pointing leo-geo.toml --sources errors.csv",
        "microrad pointing leo-geo.toml --simulate 128",
    )
)
@command
def pointing(
    file: Annotated[Path, typer.Argument(help="Mission file with a table [fine_pointing].", metavar="FILE")],
    window: Annotated[
        list[float] | None,
        time_option("--window", "Length of a window [default: those of the requirements, else 10 ms, 1 s];"),
    ] = None,
    spacing: Annotated[
        list[float] | None, time_option("--spacing", "From the begin of a window to that of another;")
    ] = None,
    controller: Annotated[str, option("--controller", "NAME", "One that microrad design lists.")] = "PI",
    sources: Annotated[
        Path | None, option("--sources", "LIST", "Sources of errors as CSV or XLSX, a row each.")
    ] = None,
    simulate: Annotated[
        int | None, option("--simulate", "RUNS", "Runs of the loop in the same windows, with hysteresis.")
    ] = None,
    as_json: Json = False,
) -> Outcome:
    """Print the pointing errors of a mission in time windows, and its budget of them.

    The indices are those of ECSS-E-ST-60-10C: all of the error (APE), its mean over a window (MPE), what is left beside
    that mean (RPE), and the difference of the means of two windows (PDE). They are radial rms in theory (linear), by
    source, of what the loop leaves and of the same disturbances without a loop, exactly; the rational filters of linear
    tools stand beside that. --simulate has the same indices of runs on the mission's mirror, with intervals of 99 %,
    and the code words that are lost in them where communication.code_word says how long one is.

    A mission with a table [error_budget], or a list of sources beside it, has a budget: each requirement with its total
    by the rules of the standard and as a full distribution, what each source weighs, and how large it may become. The
    exit code is 1 when a limit is not kept.
    """
    from microrad.link.error_budget.assembly import judge
    from microrad.loop.pointing_loop.linear import close
    from microrad.loop.pointing_loop.windows import windowed_errors
    from microrad.mission.file import MissionFile, load_link, load_mission
    from microrad.report.error_budget.data import budget_data
    from microrad.report.error_budget.page import budget_view
    from microrad.report.fine_pointing.data import arrival as arrival_data
    from microrad.report.fine_pointing.simulated_windows import simulated_data, simulated_view
    from microrad.report.fine_pointing.windows import windows_data, windows_text
    from microrad.report.fine_pointing.words import arrival
    from microrad.report.view import views_text

    mission = load_link(file)
    with refusal_of(mission.path):
        indices = indices_of_mission(mission.mission.error_budget, window or [], spacing or [])
        asked = stated_beside(mission, sources, indices)
    loop, closed = mission if isinstance(mission, MissionFile) else None, None
    data, texts, code = dict[str, Any](), list[str](), MET

    def told(key: str, of_data: Callable[[], Any], of_text: Callable[[], str]) -> None:
        if as_json:
            data[key] = of_data()
        else:
            texts.append(of_text().strip("\n"))

    if asked is None or asked.with_loop or simulate is not None or (loop and loop.mission.fine_pointing):
        loop = loop or load_mission(file)
        scene, made = _designed(loop, controller)
        with refusal_of(mission.path):
            closed = close(scene.theory, made)
            errors = windowed_errors(closed, indices)
        data["controller"] = controller
        said = arrival(scene.loop)
        told("indices", lambda: windows_data(errors), lambda: windows_text(errors, controller, width(), said))
        data |= arrival_data(scene)
        if simulate is not None:
            kept, left_out = (indices, []) if window or spacing else _fitting(scene, indices)
            errors_of_runs, lost, coded = _simulated(loop, scene, made, kept, simulate)
            found = errors_of_runs, lost, simulate, left_out, coded
            view = simulated_view(*found)
            told("simulated", lambda: simulated_data(*found), lambda: views_text(view.blocks, width()))
    if asked is not None:
        with refusal_of(mission.path):
            budget = judge(asked, closed)
        code = UNMET if any(each.total.holds is False for each in budget.judged) else MET
        told("budget", lambda: budget_data(budget), lambda: views_text(budget_view(budget).blocks, width()))
    if as_json:
        return Outcome(json_text({"mission_sha256": mission.sha256, **data}), code)
    return Outcome("\n\n".join(texts), code)


def _designed(mission: "MissionFile", controller: str) -> "tuple[AnyScene, LoopController]":
    """The mission's loop, and one of its controllers."""
    from microrad import mirror as mirror_room
    from microrad.link import arrival_of, tracking_light_w
    from microrad.loop import controller_study, coupled_study

    with progress_bar() as progress, refusal_of(mission.path):
        light = tracking_light_w(mission), arrival_of(mission)
        scene = coupled_study.of_mission(mission, mirror_room.of(mission.mission), *light)
        if isinstance(scene, coupled_study.CoupledScene):
            (both,) = coupled_study.design(scene, progress, [controller]).made
            return scene, both.controller
        assert isinstance(scene, controller_study.Scene)
        (made,) = controller_study.design(scene, progress, [controller])
        return scene, made.controller


def _fitting(scene: "AnyScene", indices: "list[ErrorIndex]") -> "tuple[list[ErrorIndex], list[ErrorIndex]]":
    """The indices whose times fit into a run behind its settling, and the others."""
    room_s = scene.table.duration_s - scene.table.settle_s
    fits = {each: (each.window_s or 0.0) + (each.spacing_s or 0.0) <= room_s for each in indices}
    return [each for each in indices if fits[each]], [each for each in indices if not fits[each]]


def _simulated(
    mission: "MissionFile", scene: "AnyScene", made: "LoopController", indices: "list[ErrorIndex]", runs: int
) -> "tuple[tuple[SimulatedErrors, ...], LostWords | None, CodedResidual | None]":
    """The errors of so many runs in each index; words that they lose and the coded error ratio, as the mission asks."""
    from microrad import link
    from microrad.link.pointing.code_words import FadeMargin, words_asked
    from microrad.link.pointing.coded_residual import CodedBeam, coded_asked
    from microrad.link.study import solve_rate
    from microrad.loop.controller_study.results import span
    from microrad.loop.pointing_loop.simulated_windows import Question, ask, windows_asked

    table, loop, of_run = mission.mission.communication, scene.loop, span(scene.table)
    word = table.code_word_s
    with progress_bar() as progress, refusal_of(mission.path):
        asked: list[Question[Any]] = [windows_asked(loop, made, indices, of_run, scene.theory)]
        if word is not None:
            asked.append(words_asked(FadeMargin.of(link.of(solve_rate(mission).mission)), word, loop, of_run))
        if table.fading is not None:
            asked.append(coded_asked(CodedBeam.of(link.of(solve_rate(mission).mission)), loop, of_run))
        errors, *found = ask(asked, loop, made, of_run, runs, on_progress=progress)
    return errors, found[0] if word is not None else None, found[-1] if table.fading is not None else None


def _broken(designs: "tuple[Design, ...]", left: "tuple[Outlook, ...]", accept: bool) -> str:
    """The designs whose linear figure the mirror does not keep, in a sentence."""
    return broken_promises(
        [f"{d.name} ({x.times:.2f} times)" for d, x in zip(designs, left, strict=True) if not x.holds], accept
    )


def _text(
    scene: "Scene", designs: "tuple[Design, ...]", left: "tuple[Outlook, ...]", marks: list[str], warnings: list[str]
) -> str:
    from microrad.core.units import format_quantity
    from microrad.report.tables import Table, tables_text

    rate = format_quantity(1.0 / scene.loop.timing.period_s, "Hz")
    about = (
        f"One axis at {rate}: rms of the residual in µrad, linear and simulated on the mission's mirror with its "
        "hysteresis; margins of the linear sampled loop with its delay."
    )
    rows, tuned = [], []
    for d, x, mark in zip(designs, left, marks, strict=True):
        margins = _data(d, x, mark)["margins"]
        rms = f"{x.linear_rad * 1e6:.3f}", f"{x.simulated_rad * 1e6:.3f} {mark}".strip()
        gain = "none" if margins["gain_up_db"] is None else f"{margins['gain_up_db']:.1f} dB"
        bandwidth = format_quantity(margins["bandwidth_hz"], "Hz", 3)
        rows.append((d.name, *rms, f"{margins['modulus']:.3f}", f"{margins['phase_deg']:.0f}°", gain, bandwidth))
        tuned.append((d.name, tuned_text(scene, d.tuned.values, d.margin)))
    headings = ("controller", "linear", "simulated", "modulus", "phase", "gain", "bandwidth")
    tables = [Table("", headings, rows, (0,)), Table("", ("controller", "tuned to"), tuned, (1,))]
    said = tables_text([], [about], width()), tables_text(tables, [f"Warning: {each}." for each in warnings], width())
    return "\n\n".join(text.strip("\n") for text in said)


def _data(d: "Design", left: "Outlook", mark: str) -> dict[str, Any]:
    import math

    m, system = d.tuned.margins, d.controller.system
    return {
        "name": d.name,
        "inverse": d.inverse,
        "tuned": d.tuned.values,
        **({} if d.margin is None else {"tuned_for_modulus_margin": d.margin}),
        "bound_by": list(d.tuned.bound_by),
        "residual_rms_rad_per_axis": left.linear_rad,
        "simulated_rms_rad_per_axis": left.simulated_rad,
        "mark": mark,
        "margins": {
            "modulus": m.modulus,
            "gain_up_db": 20.0 * math.log10(m.gain_up) if math.isfinite(m.gain_up) else None,
            "phase_deg": math.degrees(m.phase_rad),
            "delay_s": m.delay_s,
            "disk": m.disk,
            "crossover_hz": m.crossover_hz,
            "bandwidth_hz": m.bandwidth_hz,
        },
        "matrices": {
            **{key: getattr(system, key).tolist() for key in "ABCD"},
            "anti_windup": d.controller.anti_windup.tolist(),
        },
    }
