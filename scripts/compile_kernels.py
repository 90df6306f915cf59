"""Compile the ensemble of loops, which takes half a minute: each process of a first test run would do it for itself."""

from pathlib import Path

from microrad import load_mission, mirror
from microrad.link.tracking_light import tracking_light_w
from microrad.loop import fine_pointing

file = load_mission(Path(__file__).parent.parent / "missions" / "leo-geo.toml")
scene = fine_pointing.scene(file, mirror.of(file.mission), tracking_light_w(file))
fine_pointing.run_one(scene, "PI")
