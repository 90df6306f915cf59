"""What `microrad design` does with a mirror file of several axes: one controller of all axes, margins of the whole."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from microrad.cli.frame import MET, UNMET, Outcome, json_text, progress_bar, refusal_of, width

if TYPE_CHECKING:
    from microrad.loop.controller_study import AnyScene
    from microrad.loop.coupled_study import CoupledDesign, CoupledDesigns, CoupledOutlook, CoupledScene
    from microrad.mission.file import MissionFile
    from microrad.mission.tables.coupled_mirror import CoupledMirror


def design_of_several_axes(mission: "MissionFile", mirror: "CoupledMirror", accept: bool, as_json: bool) -> Outcome:
    """Design controllers for a mission's loop with a mirror of several axes.

    Args:
        mission: The mission.
        mirror: The table of the mirror.
        accept: Whether designs count whose linear figure the simulation does not bear out.
        as_json: Whether the text is to be JSON.
    """
    from microrad.link import arrival_of, tracking_light_w
    from microrad.loop import coupled_study
    from microrad.mirror import coupled
    from microrad.report.fine_pointing.words import left_out

    plant = coupled.of(mirror)
    with progress_bar() as progress, refusal_of(mission.path):
        scene = coupled_study.scene(mission, plant, tracking_light_w(mission), arrival_of(mission))
        found, left = coupled_study.design_and_promise(scene, progress)
    marks = [each.worst.mark(accept) for each in left]
    named = zip(found.made, left, strict=True)
    broken = [f"{d.name} ({each.worst.times:.2f} times)" for d, each in named if not each.holds]
    warnings = [*filter(None, [broken_promises(broken, accept)]), *left_out(scene), *found.refused.values()]
    code = UNMET if "refused" in marks else MET
    if as_json:
        controllers = [_data(*each) for each in zip(found.made, left, marks, strict=True)]
        said = {"mission_sha256": mission.sha256, "mirror": plant.mirror.name, "controllers": controllers}
        return Outcome(json_text({**said, "warnings": warnings}), code)
    return Outcome(_text(scene, found, left, marks, warnings), code)


def broken_promises(named: Sequence[str], accept: bool) -> str:
    """The designs whose linear figure the mirror does not keep, in a sentence; nothing where there are none.

    Args:
        named: Those designs, each with how many times as much is left.
        accept: Whether they are taken all the same.
    """
    from microrad.loop.controller_study import PROMISE

    if not named:
        return ""
    advice = (
        "accepted as they are"
        if accept
        else "refused, here and by microrad export; choose by the simulated figure, or take these with --accept"
    )
    return (
        f"more than {PROMISE:g} times as much as linear theory says is left, simulated on the mission's mirror, by "
        f"{', '.join(named)}: {advice}"
    )


def tuned_text(scene: "AnyScene", values: Mapping[str, float], margin: float | None) -> str:
    """What a controller was tuned to, in words.

    Args:
        scene: The loop that it was tuned for.
        values: Its parameters by name, in SI units.
        margin: Modulus margin that hysteresis made it be tuned for; None for the mission's.
    """
    from microrad.report.fine_pointing.data import parameter_units
    from microrad.report.fine_pointing.words import larger_margin, tuned_to

    return tuned_to(values, parameter_units(scene)) + larger_margin(margin)


def reach_share_percent(still_v: float, rms_v: float, reach_v: tuple[float, float]) -> float:
    """What a drive with three times its rms takes of the nearer end of its reach, in percent.

    Args:
        still_v: The drive that stands still (V), as a size.
        rms_v: Rms about it (V).
        reach_v: Ends of the reach, the lower one below 0 (V).
    """
    return 100.0 * (still_v + 3.0 * rms_v) / min(reach_v[1], -reach_v[0])


def _text(
    scene: "CoupledScene",
    found: "CoupledDesigns",
    left: "Sequence[CoupledOutlook]",
    marks: Sequence[str],
    warnings: Sequence[str],
) -> str:
    from microrad.core.units import format_quantity, plain
    from microrad.report.tables import Table, tables_text

    mirror = scene.mirror.mirror
    about = (
        f"{mirror.name}: {mirror.actuators} actuators and {mirror.axes} outputs, line of sight of 2 axes at "
        f"{format_quantity(scene.table.rate_hz, 'Hz')}. Rms of the residual by axis in µrad, linear for small motions "
        "about rest, and simulated with hysteresis; margins with both axes closed, the smallest at rest and over the "
        "whole drive range."
    )
    rows, tuned = [], []
    for d, each, mark in zip(found.made, left, marks, strict=True):
        linear, simulated = (
            " / ".join(f"{1e6 * value:.3f}" for value in values)
            for values in ([a.linear_rad for a in each.axes], [a.simulated_rad for a in each.axes])
        )
        margins = d.margins
        bandwidth = format_quantity(margins.bandwidth_hz, "Hz", 3)
        figures = f"{margins.modulus:.3f}", f"{margins.disk.disk:.3f}", bandwidth
        rows.append((d.name, linear, f"{simulated} {mark}".strip(), *figures))
        tuned.append((d.name, tuned_text(scene, d.tuned, d.margin)))
    headings = ("controller", "linear x / y", "simulated x / y", "modulus", "disk", "bandwidth")
    best, (low, high) = (
        min(zip(left, found.made, strict=True), key=lambda each: each[0].simulated_rad)[1],
        scene.reach_v,
    )
    drives = [
        (actuator.name, f"{known:.3g}", f"{rms:.3g}", f"{plain(reach_share_percent(known, rms, scene.reach_v))} %")
        for actuator, known, rms in zip(scene.mirror.actuators, scene.static_v, best.drive_v.tolist(), strict=True)
    ]
    reach = f"{min(high, -low):.4g} V"
    tables = [
        Table("", headings, rows, (0,)),
        Table("", ("controller", "tuned to"), tuned, (1,)),
        Table("", (f"actuator under {best.name}", "reference, V", "rms, V", f"with 3 rms of {reach}"), drives, (0,)),
    ]
    said = tables_text([], [about], width()), tables_text(tables, [f"Warning: {each}." for each in warnings], width())
    return "\n\n".join(text.strip("\n") for text in said)


def _data(d: "CoupledDesign", left: "CoupledOutlook", mark: str) -> dict[str, Any]:
    m, system, forward = d.margins, d.controller.system, d.controller.forward
    return {
        "name": d.name,
        "tuned": dict(d.tuned),
        **({} if d.margin is None else {"tuned_for_modulus_margin": d.margin}),
        "residual_rms_rad": [axis.linear_rad for axis in left.axes],
        "simulated_rms_rad": [axis.simulated_rad for axis in left.axes],
        "drive_rms_v": d.drive_v.tolist(),
        "mark": mark,
        "margins": {
            "modulus": m.modulus,
            "disk": m.disk.disk,
            "disk_hz": m.disk.freq_hz,
            "bandwidth_hz": m.bandwidth_hz,
        },
        "matrices": {
            **{key: getattr(system, key).tolist() for key in "ABCD"},
            "anti_windup": d.controller.anti_windup.tolist(),
            **({} if forward is None else {"drives_of_hysteresis": forward.drives.tolist()}),
        },
    }
