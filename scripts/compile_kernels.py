"""Compile the ensemble of loops and the equations of LQG: each process of a first test run would do it for itself.

It takes half a minute.
"""

from pathlib import Path

from microrad import load_mission, mirror
from microrad.link.tracking_light import tracking_light_w
from microrad.loop import fine_pointing

file = load_mission(Path(__file__).parent.parent / "missions" / "leo-geo.toml")
scene = fine_pointing.scene(file, mirror.of(file.mission), tracking_light_w(file))
for name in ("PI", "LQG"):
    fine_pointing.run_one(scene, name)
