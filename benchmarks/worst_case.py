"""Seconds of `microrad worst-case`, beside the bar of 10 s on two idle cores, and of its parts.

    python benchmarks/worst_case.py                  the mirror of the mission, with what is known of six parameters
    python benchmarks/worst_case.py MIRROR           another mirror of one axis, from its file

The whole command in a process of its own, then the figures of 2024 mirrors one by one and at once. The mirror of two
axes is that of docs/mirror-file.md, which knows four parameters: 1000 draws and 16 corners.
"""

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # as the command line does, before NumPy is loaded

import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "tests"))

import several_axes
from microrad.loop import control, worst_case
from microrad.loop.pointing_loop.design import design_plant
from microrad.loop.pointing_loop.linear import close, stationary
from microrad.loop.pointing_loop.loop import assemble
from microrad.mission.file import load_loop
from places import ROOT
from recorded import record
from scenes import scene_of

BAR_S = 10.0
MISSION = ROOT / "missions" / "paper.toml"
IDENTIFIED = ROOT / "tests" / "corpus" / "0.2.0" / "mirrors" / "identified.toml"
ONE_BY_ONE = 40


def main() -> None:
    mirror = Path(sys.argv[1]) if len(sys.argv) > 1 else IDENTIFIED
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        (place / "two-axes.toml").write_text(several_axes.TEXT, encoding="utf-8")
        (place / "mission.toml").write_text(several_axes.mission_text(), encoding="utf-8")
        tell("worst case, one axis, the whole command", lambda: command(MISSION, mirror))
        tell(
            "worst case, two axes, the whole command", lambda: command(place / "mission.toml", place / "two-axes.toml")
        )
    file, _ = load_loop(MISSION, mirror)
    scene, known = scene_of(file), worst_case.of_table(file.mission.mirror)
    axis = control.PI.build(design_plant(scene.axis), [150.0, 500.0])
    simulated = worst_case.Simulated(scene.axis, assemble(axis.name, scene.axis, axis), at_rest=False)
    subject = worst_case.Subject(scene.axis, scene.loop.axes, simulated, known)
    drawn = known.drawn(2024, 1)
    at_once = seconds(lambda: subject.figures(drawn, (worst_case.APE,), None))

    def each() -> None:
        for one, _ in drawn[:ONE_BY_ONE]:
            loop = replace(scene.axis, mirror=one)
            stationary(close(loop, simulated.controller))
            control.loop_margins(design_plant(loop), axis)

    one_by_one = seconds(each) * len(drawn) / ONE_BY_ONE
    print(f"figures of {len(drawn)} mirrors: {at_once:.2f} s at once, {one_by_one:.1f} s one by one")
    record("figures of 2024 mirrors at once", at_once, "s")


def command(mission: Path, mirror: Path) -> None:
    """The command, as a user gives it."""
    words = [sys.executable, "-m", "microrad", "worst-case", str(mission), "--mirror", str(mirror)]
    subprocess.run(words, check=True, capture_output=True)


def tell(what: str, do: Callable[[], None]) -> None:
    """Do it once behind a first time, which may compile, and print its line."""
    do()
    took = seconds(do)
    record(what, took, "s", at_most=BAR_S)
    print(f"{what:44s} {took:5.1f} s, bar {BAR_S:g} s{'' if took <= BAR_S else '  over'}")


def seconds(do: Callable[[], object]) -> float:
    """How long it takes by the clock."""
    began = time.perf_counter()
    do()
    return time.perf_counter() - began


if __name__ == "__main__":
    main()
