"""Compile the loops that most tests run: each process of a first test run would take half a minute for it."""

from pathlib import Path

from microrad import load_mission, mirror
from microrad.link import tracking_light_w
from microrad.loop import fine_pointing, paper_cases
from microrad.study import alternatives

file = load_mission(Path(__file__).parent.parent / "missions" / "leo-geo.toml")
mirrors = mirror.of(file.mission)
scene = fine_pointing.scene(file, mirrors, tracking_light_w(file))
for name in ("PI", "LQG"):
    fine_pointing.run_one(scene, name)
cases = paper_cases.of(file.mission, mirrors)
paper_cases.hysteresis_loops(cases)
runs = paper_cases.tracking_runs(cases)
alternatives.other_readings(file.mission, paper_cases.worst(runs, file.mission.requirement.residual_statistic))
