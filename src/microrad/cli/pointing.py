"""Commands of the fine-pointing loop: controllers designed for a mission, with their margins and what they leave."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from microrad.cli.frame import Json, Outcome, Refusal, app, command, examples, json_text, option, progress_bar

# Everything else is imported inside the commands: it takes longer to load than help may take.
if TYPE_CHECKING:
    from microrad.fine_pointing import Design, Outlook, Scene


@app.command(
    epilog=examples(
        "microrad design leo-geo.toml",
        "microrad design leo-geo.toml --mirror lab-mirror.toml",
        "microrad design leo-geo.toml --json > controllers.json",
    )
)
@command
def design(
    file: Annotated[Path, typer.Argument(help="Mission file with a table [fine_pointing].", metavar="FILE")],
    mirror: Annotated[Path | None, option("--mirror", "FILE", "Mirror file in place of the mission's mirror.")] = None,
    as_json: Json = False,
) -> Outcome:
    """Design controllers for a mission's fine-pointing loop.

    Each is tuned for the mission's mirror, disturbances, noise and delay under its modulus margin, for one axis, in
    theory (linear), and shown with what it leaves there and, in a few runs, on the mirror with its hysteresis; microrad
    run simulates all of it. --json also prints their matrices.
    """
    from microrad.mirror_summary import unknown_dynamics
    from microrad.missionfile import load_mission

    mission = load_mission(file, mirror)
    with progress_bar() as progress:
        try:
            from microrad import fine_pointing

            scene = fine_pointing.scene(mission)
            designs = fine_pointing.design(scene, mission.mission, progress)
            left = fine_pointing.outlook(scene, mission.mission, designs, progress)
        except ValueError as error:  # a loop that cannot be built, a margin out of reach
            raise Refusal(f"{mission.path}: {error}") from error
    warnings = list(filter(None, [unknown_dynamics(mission.mission.mirror), _broken(designs, left)]))
    if as_json:
        found = {"mission_sha256": mission.sha256, "controllers": list(map(_data, designs, left)), "warnings": warnings}
        return Outcome(json_text(found))
    return Outcome("\n".join([*_lines(scene, designs, left), *(f"warning: {text}" for text in warnings)]))


def _broken(designs: "tuple[Design, ...]", left: "tuple[Outlook, ...]") -> str:
    """The designs whose linear figure the mirror does not keep, in a sentence."""
    from microrad.fine_pointing import PROMISE

    named = [
        f"{d.name} ({x.simulated_rad / x.linear_rad:.1f} times)"
        for d, x in zip(designs, left, strict=True)
        if not x.holds
    ]
    if not named:
        return ""
    return (
        f"more than {PROMISE:g} times as much as linear theory says is left, simulated on the mission's mirror, by "
        f"{', '.join(named)}: choose by the simulated figure, microrad export c writes these with --accept alone"
    )


def _lines(scene: "Scene", designs: "tuple[Design, ...]", left: "tuple[Outlook, ...]") -> list[str]:
    from microrad.units import format_quantity

    rate = format_quantity(1.0 / scene.loop.timing.period_s, "Hz")
    lines = [
        f"one axis at {rate}: rms of the residual, linear and simulated on the mission's mirror with its hysteresis;",
        "margins of the linear sampled loop with its delay",
        "",
        f"{'':28} {'rms µrad':^19}",
        f"{'controller':28} {'linear':>9} {'simulated':>9} {'modulus':>8} {'phase °':>8} {'gain dB':>8} "
        f"{'bandwidth':>10}  tuned to",
    ]
    for d, x in zip(designs, left, strict=True):
        margins, values = _data(d, x)["margins"], ", ".join(f"{k} {v:.3g}" for k, v in d.tuned.values.items())
        gain = f"{margins['gain_up_db']:8.1f}" if margins["gain_up_db"] is not None else "    none"
        bandwidth = format_quantity(margins["bandwidth_hz"], "Hz", 3)
        lines.append(
            f"{d.name:28} {x.linear_rad * 1e6:9.3f} {x.simulated_rad * 1e6:9.3f} {margins['modulus']:8.3f} "
            f"{margins['phase_deg']:8.0f} {gain} {bandwidth:>10}  {values}"
        )
    return lines


def _data(d: "Design", left: "Outlook") -> dict[str, Any]:
    import math

    m, system = d.tuned.margins, d.controller.system
    return {
        "name": d.name,
        "inverse": d.inverse,
        "tuned": d.tuned.values,
        "bound_by": list(d.tuned.bound_by),
        "residual_rms_rad_per_axis": left.linear_rad,
        "simulated_rms_rad_per_axis": left.simulated_rad,
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
