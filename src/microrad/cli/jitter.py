"""`microrad jitter`: a recorded motion through a mission's fine-pointing loop, played and as a fitted spectrum."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from microrad.cli.frame import (
    Json,
    OnProgress,
    Outcome,
    Refusal,
    app,
    command,
    examples,
    json_text,
    option,
    progress_bar,
    quantity_of,
    refusal_of,
    width,
)

if TYPE_CHECKING:
    from microrad.lab.recording import Motion
    from microrad.loop.disturbance.recorded_fit import RecordedFit

_RECORDING = "Measured motion (CSV, text, LVM, TDMS, MAT, NPY, NPZ, HDF5), each channel one axis."
_AXES = "Its channels, by name or number from 0: one to three [default: all but the time]."
_RATE = "Its sample rate: '2 kHz' [default: what the file says]."
_UNIT = "Its unit where the file states none: urad, arcsec or another one of angles."


@app.command(
    epilog=examples(
        "microrad jitter leo-geo.toml jitter.tdms --axes 'bench/x,bench/y'",
        "microrad jitter leo-geo.toml jitter.npy --rate '2 kHz' --unit urad --json",
    )
)
@command
def jitter(
    file: Annotated[Path, typer.Argument(help="Mission file with a table [fine_pointing].", metavar="FILE")],
    recording: Annotated[Path, typer.Argument(help=_RECORDING, metavar="RECORDING")],
    *,
    axes: Annotated[str | None, option("--axes", "NAME,NAME", _AXES)] = None,
    rate: Annotated[float | None, option("--rate", "HZ", _RATE, parser=quantity_of("Hz"))] = None,
    time: Annotated[str | None, option("--time", "COLUMN", "Time (s), to read its rate off.")] = None,
    unit: Annotated[str | None, option("--unit", "UNIT", _UNIT)] = None,
    controller: Annotated[str, option("--controller", "NAME", "One that microrad design lists.")] = "PI",
    as_json: Json = False,
) -> Outcome:
    """Print what a mission's loop leaves of a recorded motion.

    The motion is taken through the linear loop in two ways: played as it is, and as the spectrum that is fitted to it,
    its lines apart. Mean and drift, what the fit leaves, and whether the motion is stationary are told, and why the two
    ways differ where they do.
    """
    from microrad import mirror as mirror_room
    from microrad.lab.recording import read_motion
    from microrad.link import arrival_of, tracking_light_w
    from microrad.loop import controller_study
    from microrad.loop.pointing_loop.played import recorded_residual
    from microrad.mission.file import load_loop
    from microrad.report.fine_pointing.recording import RecordedAxis, recording_data, recording_text

    mission, several = load_loop(file)
    if several is not None:
        raise Refusal(f"{file}: its mirror has several axes, and recordings are played to one mirror an axis")
    names = [] if axes is None else [name.strip() for name in axes.split(",")]
    motion = read_motion(recording, names, rate, time=time, unit=unit)
    with progress_bar() as progress, refusal_of(mission.path):
        light = tracking_light_w(mission), arrival_of(mission)
        scene = controller_study.scene(mission, mirror_room.of(mission.mission), *light)
        fits = _fits(motion, scene.table.settle_s, progress)
        (made,) = controller_study.design(scene, progress, [controller])
        alone = controller_study.on_one_axis(made, scene)
        left = [RecordedAxis(fit, recorded_residual(scene.axis, alone, fit, scene.table.settle_s)) for fit in fits]
    if as_json:
        data = recording_data(motion.path, motion.sha256, left, scene.axis)
        return Outcome(json_text({"mission_sha256": mission.sha256, "controller": made.name, "recording": data}))
    return Outcome(recording_text(motion.path, left, scene.axis, made.name, width()))


def _fits(motion: "Motion", settle_s: float, on_progress: OnProgress) -> "list[RecordedFit]":
    """A recording's axes as disturbances, once they are seen to be long enough for a loop that settles in that time."""
    from microrad.loop.disturbance.recorded_fit import fit_recording
    from microrad.loop.pointing_loop.played import refuse_short

    found: list[RecordedFit] = []
    with refusal_of(Path(motion.path)):
        for name, samples in zip(motion.names, motion.samples_rad.T, strict=True):
            on_progress(len(found), len(motion.names), "fitting the recording")
            found.append(fit_recording(samples, 1.0 / motion.rate_hz, name=name))
            refuse_short(found[-1], settle_s)
    return found
