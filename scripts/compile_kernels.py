"""Compile the ensemble of loops, which takes half a minute: each process of a first test run would do it for itself."""

from pathlib import Path

from microrad import load_mission
from microrad.loop import fine_pointing

fine_pointing.run_one(load_mission(Path(__file__).parent.parent / "missions" / "leo-geo.toml"), "PI")
