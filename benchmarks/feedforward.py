"""Ways to make a mirror with hysteretic stiffness follow a known reference, and what errors of its model cost them.

    python benchmarks/feedforward.py                 # both families on two axes: Bouc-Wen, plays with a polynomial
    python benchmarks/feedforward.py MIRROR.toml 50  # a mirror file of several axes, sines of 50 µrad

In the loop of missions/leo-geo.toml (5 kHz, a sample of delay, a 1 kHz amplifier, its jitter and sensor noise), a PI as
tuned for the mirror follows the point-ahead, the slow rate, and sines of 300 µrad at 15 Hz on x and 25 Hz on y.

- feedback: no feedforward;
- gain: the slow gain of the mirror about rest, with the delays made up for;
- forward: as `gain`, with the model's hysteresis run forward on the wanted motion (`with_feedforward`);
- own loop: the model in a loop with the same PI, run ahead; its drive is the feedforward, its output the reference;
- inverted: the drive with which the model follows best, found by simulating it over and over ahead of the loop, and
  sent as early as its delays ask for. Nothing that knows the model alone can do better.

Each is simulated in the mission's kernel on the mirror as modelled and on mirrors with other numbers. Radial rms of the
error in µrad: of the reference alone, without jitter and noise, and in all.
"""

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # as the command line does, before NumPy is loaded

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.ndimage import gaussian_filter1d

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "tests"))

from hysteretic_springs import AMPLITUDE_RAD, FAMILIES, driven, idle, on_springs, quiet, sines, with_errors
from microrad.core.arrays import Floats
from microrad.loop import coupled_study
from microrad.loop.pointing_loop import ensemble, traces
from microrad.loop.pointing_loop.feedforward import with_feedforward
from microrad.loop.pointing_loop.loop import (
    LoopController,
    PointingLoop,
    ReferenceFilter,
    decoupling,
    nominal_axis_gain,
)
from microrad.mirror import coupled
from microrad.mirror.coupled import CoupledMirror
from microrad.mirror.hysteresis import rest_gain
from microrad.mirror.model import linearised
from microrad.mission.file import load_coupled_mirror
from several_axes import scene_of

SPAN, RUNS = ensemble.Span(1.0, 0.4, 1), 64
ERRORS = {
    "as modelled": {},
    "gain -20 %": {"gain": 0.8},
    "gain -5 %": {"gain": 0.95},
    "width +30 %": {"width": 1.3},
    "resonance +5 %": {"resonance": 1.05},
    "resonance -5 %": {"resonance": 0.95},
}
REPEATS, SHARE, SMOOTH, EARLY_S = 6, 0.7, 4.0, 500e-6


def inverted(loop: PointingLoop, rest: PointingLoop, drive: Floats) -> Floats:
    """The drive (samples, actuators) under which the model follows its reference, from one that nearly does."""
    early = round(EARLY_S / loop.timing.period_s)
    angles = decoupling(rest) / nominal_axis_gain(rest)
    for _ in range(REPEATS):
        ran, given = driven(loop, idle(loop), drive)
        error = traces.replay(ran, given, len(drive), 0).error_rad[:, : loop.axes]
        error = np.vstack([error[early:], np.repeat(error[-1:], early, axis=0)])
        drive = drive + SHARE * gaussian_filter1d(error, SMOOTH, axis=0) @ angles.T
    return drive


def ways(
    scene: coupled_study.CoupledScene, pi: LoopController
) -> dict[str, tuple[LoopController, tuple[Floats, Floats | None] | None]]:
    """By name a controller and, where it is given them ahead of time, its drive and what is taken off its error."""
    loop, path = quiet(scene.loop), ReferenceFilter(scene.table.reference_filter_hz)
    straight = replace(loop, mirror=linearised(loop.mirror, [rest_gain(model) for model in loop.mirror.bank]))
    samples = round(SPAN.duration_s / loop.timing.period_s) + 1
    own = traces.replay(loop, pi, samples, 0)
    first = traces.replay(loop, with_feedforward("first", loop, idle(loop), path), samples, 0).commands
    return {
        "feedback": (pi, None),
        "gain": (with_feedforward("gain", straight, pi, path), None),
        "forward": (with_feedforward("forward", loop, pi, path), None),
        "own loop": (pi, (own.commands, own.error_rad)),
        "inverted": (pi, (inverted(loop, scene.rest, first), None)),
    }


def left(loop: PointingLoop, way: tuple[LoopController, tuple[Floats, Floats | None] | None], runs: int) -> float:
    controller, given = way
    if given is not None:
        ran, controller = driven(loop, controller, *given)
        return 1e6 * float(np.hypot(*ensemble.simulate(ran, controller, SPAN, runs).axis_rms_rad[: loop.axes]))
    return 1e6 * ensemble.simulate(loop, controller, SPAN, runs).radial_rms_rad


def compare(name: str, mirror: CoupledMirror, amplitude_rad: float, *changes: tuple[str, str]) -> None:
    scene = scene_of(mirror, *changes)
    (x, _) = scene.loop.references
    given = sines(x.point_ahead_rad, x.line_of_sight_rate_rad_s, amplitude_rad)
    linear = tuple(replace(each, references=given) for each in scene.linear)
    scene = replace(scene, loop=replace(scene.loop, references=given), linear=linear)
    (pi,) = coupled_study.design(scene, only=("PI",)).made
    of = ways(scene, pi.controller)
    print(f"{name}: PI of {pi.margins.bandwidth_hz:.0f} Hz\n{'':16}" + "".join(f"{way:>18}" for way in of))
    for words, errors in ERRORS.items():
        real = replace(scene.loop, mirror=with_errors(scene.loop.mirror, **errors))
        cells = (f"{left(quiet(real), way, 1):.2f} ({left(real, way, RUNS):.2f})" for way in of.values())
        print(f"{words:16}" + "".join(f"{cell:>18}" for cell in cells), flush=True)
    still = replace(scene.loop, references=sines(amplitude_rad=0.0))
    print(f"without a reference: {left(still, of['feedback'], RUNS):.2f} µrad\n")


def main() -> None:
    if sys.argv[1:]:
        mirror = coupled.of(load_coupled_mirror(sys.argv[1]))
        changes = ('output_min = "0 V"', 'output_min = "-5 V"'), ('output_max = "100 V"', 'output_max = "20 V"')
        compare(mirror.mirror.name, replace(mirror, known=None), 1e-6 * float(sys.argv[2]), *changes)
    else:
        for name, spring in FAMILIES.items():
            compare(name, on_springs(spring), AMPLITUDE_RAD)


if __name__ == "__main__":
    main()
