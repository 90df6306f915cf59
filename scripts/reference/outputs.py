"""What the other commands and the library say: campaigns, exports, orbits, loops, links by numbers, and the studio.

As in `scenes` no number is as it is shipped, and all that is said is kept word for word.
"""

import json
import math
import re
import shutil
import sqlite3
import zipfile
from collections.abc import Callable, Mapping
from contextlib import closing
from pathlib import Path
from types import MappingProxyType

import numpy as np
from scipy.io import loadmat, savemat
from scipy.signal import lfilter
from sgp4.api import WGS72, Satrec
from sgp4.exporter import export_omm, export_tle

from reference import told
from reference.cases import GALLERY, NO_DAY, ROOT, Case, Place, arrays, without
from reference.scenes import BUDGET, PAPER, SHORT, TWO_AXES, edited, generic

PROGRAMS = Path(__file__).parent / "programs"
"""Programs that print what no command says."""

DAY_TABLES = "acquisition", "orbit", "operations", "constellation"
LOOP_TABLES = "fine_pointing", "mirror", "amplifier", "control", "scenario"
WITHOUT_LOOP = dict.fromkeys(("conventions.residual", "conventions.mirror_angle", "requirement.residual_statistic"))
GROUND = (ROOT / "src/microrad/mission/missions/presets/ground-downlink.toml").read_text(encoding="utf-8")
LINKS_ALONE = edited(without(PAPER, *DAY_TABLES, *LOOP_TABLES), WITHOUT_LOOP)
BY_FILE = {"constellation.pattern": '"file"', "constellation.file": '"satellites.tle"'}
BY_FILE |= {f"constellation.{key}": None for key in ("satellites", "planes", "phasing")}
Changes = Mapping[str, str | None]
SHORT_LOOP = {key: value for key, value in SHORT.items() if key.startswith("fine_pointing.")}
SMOOTH = SHORT_LOOP | {"fine_pointing.drive_resolution": '"0 V"'}
"""Without counts, which another processor rounds the other way once in a while."""
DRIVES = {"amplifier.gain": "1", "amplifier.output_max": '"100 V"'}
ON_TWO_AXES = DRIVES | {"fine_pointing.mirror_file": '"axes.toml"'}
CODE_WORD = {"communication.code_word": '"2.3 ms"'}
JITTER = {
    "conventions.strehl": '"ratio"',
    "communication.strehl": "0.94",
    "jitter.bias": '["1.7 urad", "-1.2 urad"]',
    "jitter.rms": '["4.1 urad", "2.6 urad"]',
    "jitter.bandwidth": '"27 Hz"',
}

# ----------------------------------------------------------------------------------------------------------- campaigns
HEAD = 'mission = "mission.toml"\nseed = {}\nruns = {}\nsampling = "{}"\n'
POWER = '[inputs."communication.transmit_power"]\ndistribution = "normal"\nmean = "5.3 W"\ndeviation = "0.21 W"\n'
NOISE = """
[inputs."fine_pointing.optical_sensor.noise"]
distribution = "log-uniform"
low = "0.53 urad"
high = "2.9 urad"
"""
GRID = f"""
{HEAD.format(11, 40, "latin-hypercube")}
[set]
"requirement.outage" = 0.0023
{POWER}
[inputs."communication.transmit_optics_loss"]
distribution = "uniform"
low = "0.2 dB"
high = "0.9 dB"

[inputs."beacon.pointing_error"]
distribution = "log-uniform"
low = "211 urad"
high = "307 urad"

[inputs."communication.pointing_error"]
distribution = "table"
values = ["4.1 urad", "6.3 urad", "8.7 urad"]
weights = [0.2, 0.5, 0.3]

[grid]
"communication.data_rate" = ["210 Mbit/s", "430 Mbit/s"]
"terminals.leo_aperture" = ["47 mm", "53 mm"]

[limits.margin]
least = "2.9 dB"

[limits.data_rate]
least = "190 Mbit/s"
most = "900 Mbit/s"
"""
WEIGHTED = f"""
{HEAD.format(12, 90, "random")}
keep = ["margin", "outage", "short", "data_rate"]
{POWER}
[inputs."communication.transmit_power".drawn_as]
distribution = "normal"
mean = "4.7 W"
deviation = "0.4 W"

[inputs."communication.strehl"]
distribution = "table"
values = [0.37, 0.51, 0.63]

[inputs."communication.strehl".drawn_as]
distribution = "table"
values = [0.37, 0.51, 0.63]
weights = [3.0, 1.0, 2.0]

[inputs."communication.distance"]
distribution = "uniform"
low = "41000 km"
high = "42500 km"

[inputs."communication.distance".drawn_as]
distribution = "uniform"
low = "40500 km"
high = "42700 km"

[limits.margin]
least = "2.1 dB"

[precision]
output = "margin"
quantile = 0.1
half_width = "0.2 dB"
confidence = 0.9
at_most = 300
"""
SENSITIVE = f"""
{HEAD.format(13, 128, "sobol")}
{POWER.replace("5.3 W", "1.9 W").replace("0.21 W", "0.71 W")}
[inputs."jitter.rms"]
distribution = "uniform"
low = "2.3 urad"
high = "5.1 urad"

[inputs."jitter.bias.2"]
distribution = "normal"
mean = "-1.1 urad"
deviation = "0.7 urad"

[inputs."communication.strehl"]
distribution = "normal"
mean = 0.93
deviation = 0.04

[inputs."communication.transmit_optics_loss"]
distribution = "log-uniform"
low = "0.4 dB"
high = "2.3 dB"
"""
LOOP = f"""
{HEAD.format(14, 60, "sobol")}
worst = 1
realisations = 3

[loop]
controller = "PI"
axes = "one"
mirror = "comparison"
duration = "0.07 s"
settle = "0.03 s"
{POWER}{NOISE}
[limits.residual_quantile]
most = "5.7 urad"

[limits.margin]
least = "2.7 dB"
"""
IDENTIFIED = f"""
{HEAD.format(15, 7, "random")}
worst = 2
realisations = 2

[loop]
controller = "PI"
duration = "0.1 s"
settle = "0.03 s"

[inputs.mirror]
distribution = "identified"
{NOISE}"""
UNCERTAINTY = """
[mirror.uncertainty]
parameters = ["bouc_wen.d1", "bouc_wen.alpha", "linear.numerator.2"]
standard_errors = [0.0123, 0.0137, 0.0013]
correlation = [0.51, 0.07, -0.31]
"""
TAIL = f"""
{HEAD.format(16, 80, "random")}
[loop]
controller = "PI"
mirror = "no hysteresis"
duration = "0.13 s"
settle = "0.1 s"

[tail]
error = "6.3 urad"
probability = 3e-5
"""
AXES = f"""
{HEAD.format(17, 4, "random")}
worst = 1
realisations = 2

[loop]
controller = "PI"
duration = "0.06 s"
settle = "0.03 s"

[inputs.mirror]
distribution = "identified"
{POWER}
[precision]
output = "radius"
quantile = 0.9
half_width = "0.1 urad"
confidence = 0.9
at_most = 6
"""
DAYS = f"""
{HEAD.format(18, 3, "random")}
keep = ["volume", "contact_time", "margin"]
{POWER}
[inputs."orbit.grazing_height"]
distribution = "uniform"
low = "60 km"
high = "210 km"

[limits.volume]
least = "800 GB"
"""
OPTIMISE = f"""
{HEAD.format(19, 64, "sobol")}
keep = ["margin", "data_rate"]
{POWER}
[limits.margin]
least = "3.1 dB"

[optimise]
minimise = "{{}}"
confidence = 0.93
rows = 48
evaluations = 24

[optimise.variables."terminals.leo_aperture"]
low = "41 mm"
high = "97 mm"

[optimise.variables."communication.wavelength"]
low = "1.3 um"
high = "1.7 um"
"""
SMALL = f"""
{HEAD.format(20, 9, "random")}
keep = ["margin"]
{POWER}
[grid]
"communication.data_rate" = ["210 Mbit/s", "280 Mbit/s", "430 Mbit/s"]
"""
FAULTY = {
    "keys": """
mission = "mission.toml"
seed = -3
runs = 0
sampling = "sobool"
colour = "blue"
keep = ["margn", "volume"]

[set]
"communication.transmit_powr" = "5 W"
"requirement.outage" = "0.1 m"

[grid]
"communication.data_rate" = []
"terminals.leo_aperture" = ["47 mm", "47 mm"]
"pointing.lines" = ["x"]

[loop]
controller = "PJ"
duration = "-1 s"

[limits.margin]

[limits.nothing]
least = 3

[precision]
output = "margin"
quantile = 1.3
confidence = 0.9
at_most = 10
""",
    "draws": f"""
{HEAD.format(1, 20, "random")}
[inputs."communication.transmit_power"]
distribution = "normal"
mean = "5 W"
deviation = "-0.2 W"

[inputs."communication.distance"]
distribution = "log-uniform"
low = "42000 km"
high = "41000 km"

[inputs."communication.strehl"]
distribution = "table"
values = [0.9, 0.9]
weights = [1.0]

[inputs."communication.pointing_error"]
distribution = "gauss"
mean = "5 urad"

[inputs."jitter.rms.3"]
distribution = "normal"
mean = "5 urad"
deviation = "1 urad"

[inputs.mirror]
distribution = "identified"

[inputs."terminals.leo_name"]
distribution = "uniform"
low = 1
high = 2
""",
    "twice": f"""
{HEAD.format(1, 20, "random")}
[set]
"communication.transmit_power" = "4 W"
{POWER}
[limits.margin]
least = "3 dB"
most = "2 dB"

[limits.volume]
least = "3 GB"
""",
    "weights": f"""
{HEAD.format(1, 20, "random")}
{POWER}
[inputs."communication.transmit_power".drawn_as]
distribution = "normal"
mean = "4.7 W"
deviation = "0.1 W"

[inputs."communication.distance"]
distribution = "uniform"
low = "41000 km"
high = "42500 km"

[inputs."communication.distance".drawn_as]
distribution = "uniform"
low = "41500 km"
high = "42700 km"
""",
    "alike": HEAD.format(1, 20, "random"),
    "vain": f"""
{HEAD.format(1, 20, "random")}
keep = ["margin"]
{POWER}
[inputs."beacon.transmit_power"]
distribution = "normal"
mean = "5 W"
deviation = "0.2 W"
""",
    "tail": f"""
{HEAD.format(1, 20, "random")}
keep = ["margin"]
{NOISE}
[tail]
error = "6 urad"
probability = 1e-6
""",
    "optimise": f"""
{HEAD.format(1, 20, "random")}
{POWER}
[optimise]
minimise = "-margn"
confidence = 0.9
rows = 20
evaluations = 5

[optimise.variables."terminals.leo_aperture"]
low = "5 cm"
high = "4 cm"

[optimise.variables."communication.transmit_power"]
low = "3 W"
high = "5 W"
""",
    "outside": f"""
{HEAD.format(1, 20, "random")}
[inputs."communication.strehl"]
distribution = "normal"
mean = -1.3
deviation = 0.1
""",
    "text": "mission = \n",
    "none": 'mission = "no.toml"\nseed = 1\nruns = 3\nsampling = "random"\n',
}
"""Campaign files that are refused."""


def campaign(
    text: str, seed: int, mission: str = LINKS_ALONE, changes: Changes = MappingProxyType({}), more: str = ""
) -> Callable[[Place], list[str]]:
    """A campaign of a mission with its numbers changed: what is said of it, its page and its table.

    Args:
        text: The campaign file.
        seed: Of the mission's numbers.
        mission: TOML.
        changes: Keys of the mission that are set or left out.
        more: Tables behind the mission's.
    """

    def measure(place: Place) -> list[str]:
        place.write("mission.toml", edited(generic(mission, seed), changes, more))
        place.write("axes.toml", TWO_AXES)
        place.write("campaign.toml", text)
        found = place.told("campaign", "run", "campaign.toml", program=PROGRAMS / "campaign.py")
        for words in (("report",), ("export", "rows.csv"), ("export", "rows.nc")):
            found += place.told("campaign", words[0], "campaign.ledger", *words[1:])
        return found + left(place.folder)

    return measure


def optimisation(place: Place) -> list[str]:
    """The least aperture of a mission, and the wavelength of the largest margin."""
    place.write("mission.toml", edited(generic(LINKS_ALONE, 29), {}))
    found = []
    for minimise in ("terminals.leo_aperture", "-margin"):
        place.write("campaign.toml", OPTIMISE.format(minimise))
        found += place.told("campaign", "optimise", "campaign.toml", "--threads", 1)
    found += numbers(place, "campaign", "optimise", "campaign.toml", "--threads", 1)
    return found


def ledgers(place: Place) -> list[str]:
    """A ledger without one of its chunks and with a flipped bit in another, until it is whole again."""
    place.write("mission.toml", generic(LINKS_ALONE, 28))
    place.write("campaign.toml", SMALL)
    found = []
    for command in ("status", "verify", "resume", "report"):
        found += place.told("campaign", command, "campaign.ledger")
    place.told("campaign", "run", "campaign.toml", "--workers", 1)
    with closing(sqlite3.connect(place.folder / "campaign.ledger")) as ledger, ledger:
        ledger.execute("DELETE FROM chunks WHERE cell = 1")
        ledger.execute("UPDATE chunks SET sha256 = zeroblob(32) WHERE cell = 2 AND number = 0")
    for words in (("status",), ("verify",), ("verify", "--json"), ("export", "rows.csv")):
        found += place.told("campaign", words[0], "campaign.ledger", *words[1:])
    found += place.told("campaign", "run", "campaign.toml")
    found += place.told("campaign", "resume", "campaign.ledger", "--workers", 1)
    found += [
        line
        for line in numbers(place, "campaign", "status", "campaign.ledger")
        if not line.startswith((".progress.seconds", ".progress.rows_per_s"))
    ]
    found += place.told("campaign", "verify", "campaign.ledger")
    found += place.told("campaign", "export", "campaign.ledger", "rows.csv")
    found += place.told("campaign", "export", "campaign.ledger", "rows.csv")
    found += place.told("campaign", "export", "campaign.ledger", "rows.xls")
    place.write("campaign.toml", SMALL.replace("seed = 20", "seed = 21"))
    found += place.told("campaign", "resume", "campaign.ledger")
    (place.folder / "campaign.ledger").write_bytes(b"no ledger at all")
    for command in ("status", "verify", "report"):
        found += place.told("campaign", command, "campaign.ledger")
    return found + left(place.folder)


def refused_campaigns(place: Place) -> list[str]:
    """What is said of campaign files with faults."""
    place.write("mission.toml", generic(PAPER, 27))
    found = []
    for name, text in FAULTY.items():
        found += place.told("campaign", "run", place.write(f"{name}.toml", text), "--workers", 1)
    return [*found, *place.told("campaign", "optimise", "vain.toml"), *place.told("campaign", "run", "no.toml")]


def numbers(place: Place, *words: object) -> list[str]:
    """What a command prints as JSON, a value a line."""
    first, *document, last = place.told(*words, "--json")
    return [first, *(document if last == "[2]" else told.flat("", json.loads("\n".join(document)))), last]


def left(folder: Path) -> list[str]:
    """What commands have left in a folder: pages, tables, and arrays of numbers."""
    found: list[str] = []
    for path in sorted(folder.glob("*.html")):
        found += [f"== {path.name}", *told.page(path)]
    for path in sorted(folder.glob("*.csv")):
        found += told.table(path)
    for path in sorted(folder.glob("*.nc")):
        for name, each in arrays(path).items():
            values = each["value"] if isinstance(each["value"], list) else [each["value"]]
            found.append(f"{path.name}: {name}: {told.curve(values)} {each['unit']}")
    return found


# ------------------------------------------------------------------------------------------------------------- exports
OF_THE_MACHINE = re.compile(r" +(?:time a step|cycles|stack|compiled, run|counters) .*|.*\d ns .*|.*e-\d\d dB .*")
"""Lines of a report on times and sizes of this machine's program, and on what rounding leaves."""
LONG = re.compile(r"-?\d+\.\d+(?:e[-+]?\d+)?|\b\d{7,}\b|-?\d+e[-+]?\d+")
"""A number that may be the end of a search, which is kept in 5 digits."""


ROUNDING = re.compile(
    r".*(?:rror(?:Hz)?|at_hz)(?: \S+)?: .*"
    r"|\.(?:loop|controller|models\[[34]\])\.(?:[zp]|num|zero_pole_gain|transfer_function)\b.*"
)
"""What the forms of a model differ by; zeros and poles that lie so close together that rounding moves them."""
ENTRY = re.compile(r"\{\d+, \d+, [^}]*\}")
"""Of a matrix in C, some on a line."""


def rounded(line: str) -> str:
    """A line with its long numbers in 5 digits, and what is left of a difference as 0."""
    return LONG.sub(lambda found: f"{float(found[0]):.5g}" if abs(float(found[0])) > 1e-11 else "0", line)


class Exports:
    """Exports of one case: of each file the lines that no earlier one of them had."""

    def __init__(self, place: Place, mission: str) -> None:
        """None yet.

        Args:
            place: Where they are written.
            mission: The file's name.
        """
        self.place, self.mission = place, mission
        self.said: set[str] = set()

    def __call__(self, kind: str, *words: object) -> list[str]:
        """One more.

        Args:
            kind: c, fmu or matrices.
            words: Options of the command.
        """
        folder = self.place.folder / "export"
        folder.mkdir()
        output = folder / {"c": "code", "fmu": "unit.fmu", "matrices": "models.mat"}[kind]
        found = self.place.told("export", kind, self.mission, *words, "--output", output)
        found = [rounded(line) for line in found if not OF_THE_MACHINE.fullmatch(line)]
        for path in sorted(path for path in folder.rglob("*") if path.is_file()):
            found.append(f"== {path.relative_to(folder)}")
            if path.suffix == ".csv":
                found += told.table(path)
            elif path.suffix == ".mat":
                models = {k: v for k, v in loadmat(path, simplify_cells=True).items() if k[0] != "_"}
                found += [line for line in map(rounded, told.flat("", models)) if not ROUNDING.match(line)]
            elif path.suffix == ".fmu":
                with zipfile.ZipFile(path) as unit:
                    for name in sorted(unit.namelist()):
                        found += [f"== {name}", *self._new(unit.read(name).decode())]
            elif path.suffix != ".json":
                found += self._new(path.read_text(encoding="utf-8"))
        shutil.rmtree(folder)
        return found

    def _new(self, text: str) -> list[str]:
        lines = [rounded(line) for line in told.plain(text) if not OF_THE_MACHINE.fullmatch(line)]
        entries = [entry for line in lines for entry in ENTRY.findall(line) or [line]]
        new = [entry for entry in entries if entry not in self.said]
        self.said |= set(new)
        return new


def exported(place: Place) -> Exports:
    """A mission with its numbers changed, ready to export from where there is no C compiler."""
    place.variables["PATH"] = str(place.folder)
    place.write("axes.toml", TWO_AXES)
    tripod = {"layout": '"tripod"', "actuator_radius": '"9.7 mm"', "incidence": '"13 deg"', "rotation": '"-31 deg"'}
    changes = {f"fine_pointing.geometry.{key}": value for key, value in tripod.items()}
    place.write("tripod.toml", edited(generic(NO_DAY, 32), SHORT_LOOP | changes))
    place.write("drives.toml", edited(generic(NO_DAY, 33), SHORT_LOOP | DRIVES))
    return Exports(place, place.write("mission.toml", edited(generic(NO_DAY, 31), SHORT_LOOP)))


def code(place: Place) -> list[str]:
    """Flight code of controllers of each kind in each precision."""
    export = exported(place)
    found = export("c")
    for words in (
        ("--controller", "LQG", "--precision", "single", "--name", "axes_two"),
        ("--controller", "PI", "--precision", "fixed"),
        ("--controller", "PID + inverse"),
        ("--controller", "PI + inverse in series", "--precision", "single", "--accept"),
    ):
        found += export("c", *words)
    return found


def learning(place: Place) -> list[str]:
    """Flight code with an inverse that learns, and of all axes of a mirror."""
    export = exported(place)
    words = "--mirror", "plays.toml", "--accept"
    place.write("plays.toml", generic((GALLERY / "medium-stroke.toml").read_text(encoding="utf-8"), 36))
    found = export("c", *words, "--controller", "PI + adaptive inverse in series")
    export.mission = "drives.toml"
    found += export("c", "--mirror", "axes.toml", "--controller", "PI", "--precision", "single")
    return found + export("c", "--mirror", "axes.toml", "--controller", "PI + feedforward", "--accept")


def units(place: Place) -> list[str]:
    """Co-simulation units: descriptions and sources."""
    export = exported(place)
    found = export("fmu")
    found += export("fmu", "--loop", "control", "--fmi", "3.0", "--name", "slow_mirror")
    found += export("fmu", "--controller", "PI + inverse", "--fmi", "3.0")
    export.mission = "tripod.toml"
    found += export("fmu", "--controller", "PI")
    export.mission = "drives.toml"
    found += export("fmu", "--mirror", "axes.toml", "--fmi", "3.0")
    return found + export("fmu", "--mirror", "axes.toml", "--controller", "PI")


def matrices(place: Place) -> list[str]:
    """Linear models in all their forms, and back again as a mirror file."""
    export = exported(place)
    found = export("matrices")
    for words in (("--controller", "PI"), ("--controller", "PID + inverse")):
        found += export("matrices", *words)
    said = numbers(place, "export", "matrices", "mission.toml", "--controller", "PID")
    found += [rounded(line) for line in said if not ROUNDING.match(line)]
    export.mission = "drives.toml"
    zeros = re.compile(r"\.(?:sampled_plant|loop)\.(?:[zp]|num|den|tf\w*)\b")  # rounding tells what cancels
    said = export("matrices", "--mirror", "axes.toml", "--controller", "PI")
    found += [line for line in said if not zeros.match(line)]
    savemat(place.folder / "poles.mat", {"z": [-310.0], "p": [-520.0 + 4100.0j, -520.0 - 4100.0j, -2900.0], "k": 47.0})
    savemat(place.folder / "sampled.mat", {"num": [0.0, 0.031, 0.012], "den": [1.0, -1.31, 0.52], "Ts": 1.3e-4})
    savemat(place.folder / "runaway.mat", {"num": [3.0], "den": [1.0, -20.0]})
    savemat(place.folder / "direct.mat", {"num": [3.0, 1.0], "den": [1.0, 20.0]})
    given = ("--travel", "2.3 mrad", "--drive", "0 V", "11 V", "--bias", "5.3 V", "--rate-limit", "3310 V/s")
    given = (*given, "--band", "1.3 Hz", "470 Hz", "--normalise-at", "2.7 Hz", "--output-unit", "urad")
    for name in ("poles", "sampled", "runaway", "direct", "none"):
        found += place.told("import", f"{name}.mat", *given)
    found += place.told("import", "poles.mat", *given, "--name", "Poles", "--output", "sampled-mirror.toml")
    for path in sorted(place.folder.glob("*-mirror.toml")):
        found += [f"== {path.name}", *map(rounded, told.plain(path.read_text(encoding="utf-8")))]
    return found


def refused_exports(place: Place) -> list[str]:
    """What is not exported, and why."""
    exported(place)
    place.write("links.toml", generic(LINKS_ALONE, 35))
    (place.folder / "taken").mkdir()
    place.write("taken/mine.txt", "mine")
    found: list[str] = []
    for kind, *words in (
        ("c", "mission.toml", "--controller", "PJ"),
        ("c", "mission.toml", "--name", "while"),
        ("c", "mission.toml", "--name", "2fast"),
        ("c", "mission.toml", "--name", "printf"),
        ("c", "mission.toml", "--precision", "half"),
        ("c", "mission.toml", "--output", "taken", "--overwrite"),
        ("c", "mission.toml", "--mirror", "axes.toml"),
        ("c", "links.toml"),
        ("c", "no.toml"),
        ("fmu", "mission.toml", "--fmi", "1.0"),
        ("fmu", "mission.toml", "--loop", "none"),
        ("fmu", "mission.toml", "--output", "unit.zip"),
        ("fmu", "links.toml"),
        ("matrices", "mission.toml", "--controller", "best"),
        ("matrices", "mission.toml", "--mirror", "no.toml"),
        ("matrices", "links.toml"),
        ("matrices", "mission.toml", "--output", "no/models.mat"),
    ):
        found += map(rounded, place.told("export", kind, *words))
    return found


# -------------------------------------------------------------------------------------------------------------- orbits
DAYS_ALONE = edited(
    without(PAPER, *LOOP_TABLES, r"acquisition\.scan", r"operations\.contact"),
    WITHOUT_LOOP | {"acquisition.runs": "100", "operations.runs": "4", "orbit.duration": '"5.3 h"'},
)
LIMITS = """
[orbit.leo.limits]
attitude = "{}"
boresight = {}
field_of_regard = "{} deg"
slew_limit = "{} deg/s"
sun_exclusion = "{} deg"
in_eclipse = {}
"""
KEPLERIAN = """
[orbit.{}]
kind = "keplerian"
semi_major_axis = "{} km"
eccentricity = {}
inclination = "{} deg"
node = "{} deg"
argument_of_perigee = "{} deg"
mean_anomaly = "{} deg"
gravity = "{}"
"""
FROM_FILE = '\n[orbit.{}]\nkind = "{}"\nfile = "{}"\n'
STATIONS = """
[operations.downlink.stations.south]
latitude = "-53.1 deg"
longitude = "-70.9 deg"
height = "0.3 km"
mask = "7.7 deg"

[operations.downlink.stations.equator]
latitude = "3.7 deg"
longitude = "101.3 deg"
height = "0.9 km"
mask = "11.3 deg"
"""
RELAYS = '\n[constellation.relays.third]\nlongitude = "61.7 deg"\n'
ORBITS: Mapping[str, tuple[str, Changes]] = {
    "delta": (
        STATIONS + RELAYS,
        {
            "operations.rates": '["90 Mbit/s", "230 Mbit/s", "510 Mbit/s"]',
            "operations.relay_share": "0.71",
            "constellation.satellites": "6",
            "constellation.phasing": "2",
        },
    ),
    "star": (
        LIMITS.format("sun", "[0.3, -0.2, -0.9]", 83, 1.3, 7.1, "false"),
        {
            "orbit.leo.inclination": '"53.3 deg"',
            "orbit.leo.local_time": None,
            "orbit.leo.node": '"-47 deg"',
            "orbit.leo.gravity": '"two-body"',
            "orbit.leo.altitude": '"770 km"',
            "orbit.leo.phase": '"31 deg"',
            "orbit.earth": '"sphere"',
            "constellation.pattern": '"star"',
            "constellation.satellites": "8",
            "constellation.planes": "2",
            "constellation.terminals": "2",
        },
    ),
    "keplerian": (
        KEPLERIAN.format("leo", 7400, 0.091, 63.4, 41, 271, 17, "j2")
        + LIMITS.format("nadir", "[0.1, 0.4, -0.8]", 64, 0.051, 23, "true")
        + KEPLERIAN.format("geo", 26600, 0.03, 55, 130, 11, 200, "two-body"),
        {"constellation.satellites": "3", "operations.store": '"2.1 GB"'},
    ),
    "tle": (FROM_FILE.format("leo", "elements", "satellites.tle") + 'object = "EXAMPLE 2"\n', BY_FILE),
    "omm": (FROM_FILE.format("leo", "elements", "near.kvn") + FROM_FILE.format("geo", "elements", "far.xml"), BY_FILE),
    "oem": (FROM_FILE.format("leo", "ephemeris", "satellite.oem"), BY_FILE | {"orbit.duration": '"3.1 h"'}),
    "never": ("", {"orbit.geo.longitude": '"-11 deg"', "orbit.geo.limits.field_of_regard": '"0.3 deg"'}),
}
"""Tables behind a day's mission, and its keys: an orbit in a table behind it takes the place of the mission's own."""
REFUSED_ORBITS = {
    "attitude": {"orbit.leo.limits.attitude": '"nadir"'},
    "gravity": {"orbit.leo.gravity": '"two-body"'},
    "planes": {"constellation.planes": "5"},
    "phasing": {"constellation.phasing": "3"},
    "shortest": {"constellation.shortest": '"1 min"'},
    "pattern": {"constellation.pattern": '"rosette"'},
    "no file": {"constellation.pattern": '"file"'},
    "epoch": {"orbit.epoch": '"2026-02-30T12:00:00Z"'},
    "rates": {"operations.rates": '["200 Mbit/s", "100 Mbit/s"]'},
    "mask": {"operations.downlink.stations.kiruna.mask": '"95 deg"'},
    "low": {"orbit.leo.altitude": '"101 km"', "orbit.leo.gravity": '"j2"'},
}


INVENTED = (97, 15.19, 0.0011, 21), (53, 14.87, 0.0123, 133), (72, 15.03, 0.0071, 277), (3, 1.003, 0.0007, 40)
"""Inclination (deg), revolutions a day, eccentricity and argument of perigee (deg) of satellites that do not exist."""
OEM = """CCSDS_OEM_VERS = 2.0
CREATION_DATE = 2026-03-01T00:00:00
ORIGINATOR = NOBODY
META_START
OBJECT_NAME = EXAMPLE 2
OBJECT_ID = 2026-002A
CENTER_NAME = EARTH
REF_FRAME = TEME
TIME_SYSTEM = UTC
START_TIME = {}
STOP_TIME = {}
INTERPOLATION = HERMITE
INTERPOLATION_DEGREE = 7
META_STOP
"""


def satellites(place: Place) -> None:
    """Element sets and an ephemeris of `INVENTED` satellites, in each form."""
    made = [Satrec() for _ in INVENTED]
    for i, (own, (inclination, motion, eccentricity, perigee)) in enumerate(zip(made, INVENTED, strict=True)):
        shape = eccentricity, math.radians(perigee), math.radians(inclination)
        places = 1.1 + i, motion * 2.0 * math.pi / 1440.0, 2.1 + i
        own.sgp4init(WGS72, "i", 90001 + i, 27837.37, 1.3e-5, 0.0, 0.0, *shape, *places)
        own.classification, own.intldesg, own.elnum, own.revnum = "U", f"2600{i + 1}A", 1, 1
    lines = ["\n".join((f"EXAMPLE {i}", *export_tle(each))) + "\n" for i, each in enumerate(made, 1)]
    place.write("satellites.tle", "".join(lines[:3]))
    near, far = (export_omm(made[i], f"EXAMPLE {i + 1}") for i in (0, 3))
    place.write("near.kvn", "CCSDS_OMM_VERS = 2.0\n" + "".join(f"{key} = {value}\n" for key, value in near.items()))
    place.write("near.json", json.dumps([near]))
    parts = "".join(f"<{key}>{value}</{key}>" for key, value in far.items())
    place.write("far.xml", f"<ndm><omm><body><segment>{parts}</segment></body></omm></ndm>")
    times = [f"2026-03-20T{12 + minute // 60:02d}:{minute % 60:02d}:00" for minute in range(200)]
    rows = []
    for minute, time in enumerate(times):
        _, position, velocity = made[1].sgp4(2461120.0, minute / 1440.0)
        rows.append(" ".join([time, *(f"{x:.9f}" for x in (*position, *velocity))]))
    place.write("satellite.oem", OEM.format(times[0], times[-1]) + "\n".join(rows) + "\n")


def orbits(place: Place) -> list[str]:
    """Contacts and constellations of orbits of each kind, with all limits."""
    satellites(place)
    found: list[str] = []
    for seed, (name, (more, changes)) in enumerate(ORBITS.items()):
        own = [re.escape(table) for table in re.findall(r"(?m)^\[(orbit\.\S+)\]", more)]
        file = place.write(f"{name}.toml", edited(without(generic(DAYS_ALONE, 40 + seed), *own), changes, more))
        found += place.told("constellation", file)
        if name in ("delta", "keplerian"):
            found += [*numbers(place, "contacts", file), *listed(place, "contacts", file)]
        found += listed(place, "constellation", file)
        page = place.told("contacts", file, "--html")
        drawn = told.page(place.folder / place.write("page.html", "\n".join(page[1:-1])))
        found += [line for line in drawn if not line.startswith(STEPS)]
    return found + place.told("contacts", file) + place.told("constellation", "delta.toml", "--contact-plan")


STEPS = tuple(f"plot of share of the data (%).data[0].{key}: " for key in ("x", "y", "text"))
"""A curve of latency, of which rounding tells whether a corner is one point or two."""


def listed(place: Place, *words: object) -> list[str]:
    """What a command prints as CSV."""
    first, *rows, last = place.told(*words, "--csv")
    if last == "[2]":
        return [first, *rows, last]
    return [first, *told.table(place.folder / place.write("rows.csv", "\n".join(rows))), last]


def refused_orbits(place: Place) -> list[str]:
    """Orbits and files of orbits with faults."""
    satellites(place)
    found: list[str] = []
    for name, changes in REFUSED_ORBITS.items():
        found += place.told("contacts", place.write(f"{name.replace(' ', '-')}.toml", edited(DAYS_ALONE, changes)))
    place.write("wrong.tle", (place.folder / "satellites.tle").read_text().replace("90002  ", "90002 1"))
    oem = (place.folder / "satellite.oem").read_text()
    place.write("gap.oem", re.sub(r"2026-03-20T13:.*\n", "", oem))
    place.write("frame.oem", oem.replace("TEME", "MARS"))
    place.write("word.oem", oem.replace("2026-03-20T12:07:00 ", "2026-03-20T12:07:00 x"))
    for kind, file in (
        *(("elements", name) for name in ("wrong.tle", "none.tle", "satellites.tle", "satellite.oem")),
        *(("ephemeris", name) for name in ("gap.oem", "frame.oem", "word.oem", "satellites.tle", "satellite.oem")),
    ):
        text = without(DAYS_ALONE, r"orbit\.leo", "constellation")
        more = FROM_FILE.format("leo", kind, file)
        found += place.told("contacts", place.write("mission.toml", edited(text, {}, more)), "--csv")
    more = FROM_FILE.format("leo", "elements", "near.json")
    return found + listed(place, "contacts", place.write("mission.toml", edited(text, {}, more)))


# -------------------------------------------------------------------------------------------------------------- ground
FIBRE = """
[communication.coupling]
into = "single-mode fibre"
mode_radius = "best"
"""
UP = {
    "orbit.leo.kind": '"station"',
    **{f"orbit.leo.{key}": None for key in ("altitude", "inclination", "local_time", "phase", "gravity")},
    "orbit.leo.latitude": '"41.3 deg"',
    "orbit.leo.longitude": '"12.7 deg"',
    "orbit.leo.height": '"730 m"',
    "orbit.leo.mask": '"23 deg"',
    "orbit.geo.kind": '"circular"',
    **{f"orbit.geo.{key}": None for key in ("latitude", "longitude", "height", "mask")},
    "orbit.geo.altitude": '"570 km"',
    "orbit.geo.inclination": '"63 deg"',
    "orbit.geo.node": '"17 deg"',
    "orbit.geo.phase": '"71 deg"',
    "orbit.geo.gravity": '"j2"',
}
IN_GROUND: Mapping[str, tuple[str, Changes]] = {
    "down": ("", {}),
    "fibre": (FIBRE, {"channel.turbulence.corrected_modes": "21", "channel.turbulence.fades": '"log-normal"'}),
    "no-optics": (FIBRE, {"channel.turbulence.tilt": '"gradient"', "jitter.bandwidth": '"31 Hz"'}),
    "up": ("", UP | {"channel.turbulence.wander": '"itu-r-p1622"'}),
}
REFUSED_GROUND: Mapping[str, Changes] = {
    "distance": {"communication.distance": '"1000 km"'},
    "elevation": {"channel.elevation": '"20 deg"'},
    "mask": {"orbit.geo.mask": '"5 deg"'},
    "modes": {"channel.turbulence.corrected_modes": "2"},
    "wind": {"channel.turbulence.wind_rms": None},
    "outage": {"requirement.outage": None, "jitter.bias": None},
    "sky": {"channel.zenith_transmission": "0.9"},
    "limits": {"orbit.geo.height": None},
}


def ground(place: Place) -> list[str]:
    """A link to a station down and up, into a fibre, in still air, and with faults."""
    text, found = generic(GROUND, 71), list[str]()
    for name, (more, changes) in IN_GROUND.items():
        path = place.write(f"{name}.toml", edited(text, changes, more))
        found += place.told("budget", path, "--verbose") + place.told("contacts", path)
    still = place.write("still.toml", without(text, r"channel\.turbulence"))
    found += place.told("budget", still)
    for name, changes in REFUSED_GROUND.items():
        found += place.told("budget", place.write(f"{name}.toml", edited(GROUND, changes)))
    return found


# --------------------------------------------------------------------------------------------------------------- loops
SOURCES = """name,class,size,rate,statistic,axes,x,y,corner,frequency,period,decay,origin
mounting,constant,2.1 urad,,3-sigma,each,1,0.5,,,,,ground calibration
star tracker,random,3.3 urad,,bound,each,1,-0.7,,,,,
pumps,process,0.8 urad,,1-sigma,each,0.9,1,41 Hz,,,,
slosh,transient,5.2 urad,,fixed,together,0.5,-1,,,97 min,19 s,
"""
WRONG_SOURCES = SOURCES.replace("2.1 urad", "2.1 m").replace("bound", "most").replace("97 min", "")


def recordings(place: Place) -> None:
    """Motion of one axis with a line, of two with a drift, without a time, and what is too short."""
    random = np.random.default_rng(5)
    for name, seconds, rate, columns in (("line", 6, 1000.0, 1), ("drift", 4, 1250.0, 2), ("still", 4, 800.0, 1)):
        time = np.arange(round(seconds * rate)) / rate
        motion = lfilter([1.0], [1.0, -1.8, 0.81], 0.1 * random.standard_normal((time.size, columns)), axis=0)
        slope = 1.9 * (name == "drift")
        motion += (4.7 * np.sin(2.0 * math.pi * 41.3 * time + 0.3) + 23.0 + slope * time)[:, None]
        titles = [f"axis {i} (urad)" for i in range(columns)]
        place.write(f"{name}.csv", ",".join(["time (s)", *titles]) + "\n")
        with (place.folder / f"{name}.csv").open("a") as file:
            np.savetxt(file, np.column_stack([time, motion]), delimiter=",", fmt="%.9g")
    place.write("bare.csv", "x,y\n" + "\n".join(f"{value:.9g},{-0.7 * value:.9g}" for value in motion[:, 0]) + "\n")
    place.write("short.csv", "x,y\n1.3,2.9\n-0.7,0.1\n2.1,-3.3\n")


def loops(place: Place) -> list[str]:
    """Pointing errors in windows, of lists of sources, in runs, of recordings, and on the worst mirror."""
    recordings(place)
    place.write("sources.csv", SOURCES)
    place.write("wrong.csv", WRONG_SOURCES)
    place.write("axes.toml", TWO_AXES)
    budget = BUDGET.replace("WITH_LOOP", "false")
    file = place.write("mission.toml", edited(generic(NO_DAY, 51), SHORT_LOOP, UNCERTAINTY + budget))
    place.write("plain.toml", edited(generic(NO_DAY, 52), SHORT_LOOP | CODE_WORD))
    place.write("drives.toml", edited(generic(NO_DAY, 53), SHORT_LOOP | DRIVES, BUDGET.replace("WITH_LOOP", "true")))
    place.write("links.toml", generic(LINKS_ALONE, 54))
    windows = ("--window", "3.7 ms", "--window", "0.13 s", "--spacing", "0.17 s")
    found: list[str] = []
    for words in (
        ("pointing", file, "--sources", "sources.csv"),
        ("pointing", "plain.toml", *windows, "--simulate", 3, "--controller", "PI + notch"),
        ("pointing", file, "--sources", "wrong.csv"),
        ("pointing", file, "--window", "-1 s"),
        ("pointing", file, "--controller", "PJ"),
        ("pointing", "links.toml"),
        ("worst-case", "drives.toml", "--mirror", "axes.toml", "--controller", "PI"),
        ("worst-case", "plain.toml"),
        ("worst-case", file, "--controller", "none"),
        ("jitter", file, "line.csv"),
        ("jitter", file, "drift.csv", "--axes", "axis 1 (urad)"),
        ("jitter", file, "bare.csv", "--rate", "0.83 kHz", "--unit", "arcsec", "--axes", "1"),
        ("jitter", file, "bare.csv"),
        ("jitter", file, "bare.csv", "--rate", "0.83 kHz", "--unit", "kg"),
        ("jitter", file, "short.csv", "--rate", "10 Hz", "--unit", "urad"),
        ("jitter", file, "drift.csv", "--axes", "axis 7"),
        ("jitter", file, "line.csv", "--time", "axis 0 (urad)"),
        ("design", "links.toml"),
    ):
        found += place.told(*words)
    return found + numbers(place, "worst-case", file, *windows)


def design_of_axes(place: Place) -> list[str]:
    """Controllers of all axes of a mirror."""
    place.write("axes.toml", TWO_AXES)
    file = place.write("mission.toml", edited(generic(NO_DAY, 56), SHORT_LOOP | DRIVES))
    return place.told("design", file, "--mirror", "axes.toml")


# ------------------------------------------------------------------------------------------------------------- library
def links_by_numbers(place: Place) -> list[str]:
    """Functions of links and pointing."""
    place.write("links.toml", generic(LINKS_ALONE, 61))
    return place.printed(PROGRAMS / "links.py")


def loops_by_numbers(place: Place) -> list[str]:
    """Functions of loops, disturbances and orbits."""
    satellites(place)
    return place.printed(PROGRAMS / "loops.py")


UNFINISHED = {"terminals.leo_aperture": '"-5 cm"', "communication.data_rate": '"unknown"', "beacon.divergence": "3"}


def studio(place: Place) -> list[str]:
    """What the studio's pages show of missions and drafts, of jobs, recordings and strangers."""
    text = edited(generic(PAPER, 63), SHORT_LOOP | {key: SHORT[key] for key in SHORT if key.startswith("scenario.")})
    place.write("mission.toml", text)
    place.write("links.toml", edited(generic(LINKS_ALONE, 64), {"requirement.margin": '"19 dB"'}))
    place.write("unfinished.toml", edited(generic(LINKS_ALONE, 65), UNFINISHED).replace("[channel]", "[chanel]"))
    place.write("broken.toml", 'name = "x\n[terminals\nleo_aperture = 5 cm\n')
    place.write("campaign.toml", GRID)
    recordings(place)
    rows = (f"{i / 9700},{3.1 * math.sin(0.13 * i):.6g},{0.21 * math.sin(0.13 * i - 0.2):.6g}" for i in range(900))
    place.write("loop.csv", "time (s),drive (V),angle (mrad)\n" + "\n".join(rows) + "\n")
    return place.printed(PROGRAMS / "studio.py")


CASES: Mapping[str, Case] = {
    "campaign-grid": Case(campaign(GRID, 21)),
    "campaign-weighted": Case(campaign(WEIGHTED, 22)),
    "campaign-sensitive": Case(campaign(SENSITIVE, 23, changes=JITTER), inside=False),
    "campaign-loop": Case(campaign(LOOP, 24, NO_DAY, SHORT_LOOP)),
    "campaign-identified": Case(campaign(IDENTIFIED, 25, NO_DAY, SHORT_LOOP, UNCERTAINTY), quick=False),
    "campaign-tail": Case(campaign(TAIL, 26, NO_DAY, SMOOTH)),
    "campaign-axes": Case(campaign(AXES, 27, NO_DAY, SHORT_LOOP | ON_TWO_AXES)),
    "campaign-days": Case(campaign(DAYS, 28, PAPER, SHORT)),
    "campaign-optimise": Case(optimisation),
    "campaign-ledgers": Case(ledgers, quick=False),
    "campaign-refused": Case(refused_campaigns),
    "export-code": Case(code, quick=False),
    "export-learning": Case(learning, quick=False),
    "export-units": Case(units, quick=False),
    "export-matrices-told": Case(matrices),
    "export-refused": Case(refused_exports),
    "orbits": Case(orbits, quick=False),
    "orbits-refused": Case(refused_orbits),
    "ground": Case(ground, quick=False),
    "loops": Case(loops, quick=False),
    "design-axes": Case(design_of_axes, quick=False),
    "library-links": Case(links_by_numbers),
    "library-loops": Case(loops_by_numbers, quick=False),
    "studio": Case(studio),
}
"""All of them; a file reference/told/NAME.txt each."""
