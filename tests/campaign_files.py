"""Campaign files for tests: the shipped mission beside them, mirrors with what an identification knows of them."""

from pathlib import Path

from microrad.campaign.file import load_campaign
from shipped import SHIPPED, without_fine_pointing

HEAD = """mission = "mission.toml"
seed = 1
runs = 256
sampling = "sobol"
"""
LOOP = '[loop]\ncontroller = "PI"\nduration = "1 s"\n'
POWER = '[inputs."communication.transmit_power"]\ndistribution = "normal"\nmean = "5 W"\ndeviation = "0.2 W"\n'
NOISE = (
    '[inputs."fine_pointing.optical_sensor.noise"]\ndistribution = "log-uniform"\nlow = "0.5 urad"\nhigh = "2 urad"\n'
)
IDENTIFIED = '[inputs.mirror]\ndistribution = "identified"\n'
UNCERTAINTY = """
[uncertainty]
parameters = ["bouc_wen.d1", "bouc_wen.alpha", "linear.poles.1"]
standard_errors = [0.02, 0.03, 0.01]
correlation = [0.5, 0.0, -0.3]
"""
MIRROR = """name = "mirror of a test"
travel = "2.5 mrad"
composition = "cascade"
rate_limit = "3770 V/s"
bias = "6 V"
drive_min = "0 V"
drive_max = "12 V"

[linear]
poles = ["1 kHz"]
pole_dampings = [0.5]
normalise_at = "2 Hz"
excited_from = "1 Hz"
excited_to = "5 kHz"

[bouc_wen]
d1 = "0.089 mrad/V"
d2 = "-2.96e-7 s/V"
epsilon = "-0.022 mrad/V"
delta = "0.00047 s/V"
alpha = "2.4 1/V"
beta = "0.6 1/V"
"""


def written(folder: Path, text: str, *, whole: bool = True, changes: tuple[tuple[str, str], ...] = ()) -> Path:
    """A campaign file beside a copy of the shipped mission with pieces of its text replaced."""
    mission = SHIPPED.read_text(encoding="utf-8")
    mission = mission if whole else without_fine_pointing(mission)
    for old, new in changes:
        assert mission.count(old) == 1, old
        mission = mission.replace(old, new)
    (folder / "mission.toml").write_text(mission, encoding="utf-8")
    (folder / "mirror.toml").write_text(MIRROR + UNCERTAINTY, encoding="utf-8")
    (folder / "plain.toml").write_text(MIRROR.replace("mirror of", "plain mirror of"), encoding="utf-8")
    path = folder / "campaign.toml"
    path.write_text(text, encoding="utf-8")
    return path


def loaded(folder: Path, text: str, **how):
    """The campaign of such a file."""
    return load_campaign(written(folder, text, **how))
