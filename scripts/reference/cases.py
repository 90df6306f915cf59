"""The cases: what is run in an empty folder, by the command line alone, and what it prints or writes.

Nothing is imported from microrad: code that moves between modules leaves the cases as they are.
"""

import csv
import functools
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from reference import told, warm

ROOT = Path(__file__).resolve().parent.parent.parent
GALLERY = ROOT / "docs" / "gallery"
MISSION = (ROOT / "missions" / "paper.toml").read_text(encoding="utf-8")
EXPERIMENT = (ROOT / "plans" / "paper-experiment.toml").read_text(encoding="utf-8")


class SkippedError(Exception):
    """A case that this machine cannot run; its text says why."""


class CommandFailedError(Exception):
    """A command that did not do what its case wants."""


class Place:
    """A folder of a case and the commands that run in it."""

    def __init__(self, folder: Path) -> None:
        """An empty folder with the shipped mission in it."""
        self.folder = folder
        self.variables: dict[str, str] = {}  # of the environment, in place of this process's
        self.write("leo-geo.toml", MISSION)

    def write(self, name: str, text: str) -> str:
        """A file of the folder; returns its name."""
        (self.folder / name).write_text(text, encoding="utf-8")
        return name

    def run(self, *words: object) -> str:
        """A command of microrad, which may also end with 1, a requirement not met; returns what it prints."""
        command = [str(word) for word in words]
        if warm.is_loaded:
            return _told(["microrad", *command], (0, 1), *warm.run(command, self.folder, self._environment()))
        return self.program(sys.executable, "-m", "microrad", *command, ends=(0, 1))

    def told(self, *words: object, program: Path | None = None) -> list[str]:
        """A command of microrad and whatever it says, as lines.

        Args:
            words: The command.
            program: A file of Python that is microrad but for what its first line says.
        """
        command = [str(word) for word in words]
        code, out, err = warm.run(command, self.folder, self._environment(), program)
        if code not in (0, 1, 2):
            raise CommandFailedError(f"microrad {' '.join(command)} ended with {code}: {err.strip()}")
        # Where nobody has run the loops before, and where a machine is slow.
        said = re.sub(r"microrad: (?:compiling the loops|\d+ of \d+:) .*\n", "", err)
        return told.plain(f"$ microrad {' '.join(command)}\n{out}{said}[{code}]")

    def json(self, *words: object) -> Any:
        """The JSON document that a command prints."""
        return json.loads(self.run(*words, "--json"))

    def printed(self, program: Path) -> list[str]:
        """What a program in Python prints, as lines."""
        code, out, err = warm.run([], self.folder, self._environment(), program)
        if code:
            raise CommandFailedError(f"{program.name} ended with {code}: {err.strip()}")
        return told.plain(out + err)

    def python(self, program: Path, word: str) -> str:
        """A program in Python with a word behind its name; returns what it prints."""
        if warm.is_loaded:
            return _told([program.name, word], (0,), *warm.run([word], self.folder, self._environment(), program))
        return self.program(sys.executable, program, word)

    def program(self, *words: object, ends: tuple[int, ...] = (0,)) -> str:
        """Any program; returns what it prints."""
        command = [str(word) for word in words]
        done = subprocess.run(
            command, cwd=self.folder, env=self._environment(), capture_output=True, text=True, check=False
        )
        return _told(command, ends, done.returncode, done.stdout, done.stderr)

    def _environment(self) -> dict[str, str]:
        """With the threads of the linear algebra as a user has them."""
        given = {name: value for name, value in os.environ.items() if name != "OPENBLAS_NUM_THREADS"}
        return given | {"XDG_STATE_HOME": str(self.folder / "state"), "MICRORAD_KEEP": "no"} | self.variables


def _told(command: list[str], ends: tuple[int, ...], code: int, out: str, err: str) -> str:
    if code not in ends:
        raise CommandFailedError(f"{' '.join(command)} ended with {code}: {err.strip()}")
    return out


@dataclass(frozen=True)
class Case:
    """What is run for a file of the reference; `quick` ones are compared at every gate.

    What is told of a `simulated` loop has digits that a rounding moves. What functions return `inside` is held where it
    does not depend on how fast the machine is.
    """

    measure: Callable[[Place], Any]
    quick: bool = True
    simulated: bool = False
    inside: bool = True


# --------------------------------------------------------------------------------------------------------------- files
def changed(text: str, *changes: tuple[str, str]) -> str:
    """A text with pieces of it replaced, each of which is there once."""
    for old, new in changes:
        if text.count(old) != 1:
            raise CommandFailedError(f"{old!r} is there {text.count(old)} times in place of once")
        text = text.replace(old, new)
    return text


def without(text: str, *tables: str) -> str:
    """A TOML text without the tables of these names and those below them."""
    blocks = re.split(r"(?m)^(?=\[)", text)
    return "".join(block for block in blocks if not re.match(rf"\[(?:{'|'.join(tables)})[.\]]", block))


def arrays(path: Path) -> dict[str, dict[str, Any]]:
    """Arrays of numbers in a results file, with their units."""
    found: dict[str, dict[str, Any]] = {}

    def keep(name: str, item: object) -> None:
        if isinstance(item, h5py.Dataset) and item.dtype.kind == "f" and "units" in item.attrs:
            unit = str(item.attrs["units"])
            values = item[()].tolist() if item.ndim == 0 else item[()].ravel().tolist()
            found[name.replace("/", ".")] = {"unit": "" if unit == "1" else unit, "value": values}

    with h5py.File(path) as file:
        file.visititems(keep)
    return found


def columns(path: Path) -> dict[str, Any]:
    """Columns of numbers of a CSV file, by their headings, `name [unit]` or `name_unit`."""
    with path.open(encoding="utf-8", newline="") as file:
        heading, *rows = csv.reader(line for line in file if not line.startswith("#"))
    found: dict[str, Any] = {}
    for i, title in enumerate(heading):
        name, _, unit = title.partition(" [")
        if _numeric(rows, i):
            values = [float(row[i] or "nan") for row in rows]
            found[name] = {"unit": unit.rstrip("]"), "value": values} if unit else values
    return found


def _numeric(rows: list[list[str]], column: int) -> bool:
    try:
        return all(float(row[column] or "nan") is not None for row in rows)
    except ValueError:
        return False


# ------------------------------------------------------------------------------------------------------------- mission
NO_DAY = without(MISSION, "acquisition", "orbit", "operations", "constellation")
"""The shipped mission without what it delivers in a day."""

LOOPS = without(NO_DAY, "fine_pointing")
"""The same without its fine-pointing loop: a study of seconds."""


def mission(place: Place) -> Any:
    """The paper's mission, run; its links are those of the case `budget`."""
    summary = place.json("run", "leo-geo.toml")
    del summary["links"]
    return summary


def mission_shipped(place: Place) -> Any:
    """The mission that `microrad init` writes, run, with its links."""
    place.run("init", "shipped.toml")
    return place.json("run", "shipped.toml")


def mission_results(place: Place) -> Any:
    """What the paper's mission leaves in its results file."""
    place.run("run", "leo-geo.toml", "--output", "study")
    return arrays(place.folder / "study" / "results.nc")


def budget(place: Place) -> Any:
    """Link, pointing and acquisition budgets of the shipped mission, with the rate that was solved for."""
    return {
        "budget": place.json("budget", "leo-geo.toml"),
        "solved": place.json("budget", "leo-geo.toml", "--data-rate", "largest")["largest_data_rate_bit_s"],
    }


def command(*words: str) -> Callable[[Place], Any]:
    """One command on the shipped mission."""
    return lambda place: place.json(*words, "leo-geo.toml")


def standard(place: Place) -> Any:
    """The shipped mission against the standard that is known."""
    return {"standard": place.json("budget", "leo-geo.toml", "--standard", "sda")["standard"]}


# ------------------------------------------------------------------------------------------------------------- presets
GIVEN = {
    "pointing.lines.body_pointing.error": '"300 urad"',
    "terminals.leo_aperture": '"8 cm"',
    "terminals.geo_aperture": '"15 cm"',
    "terminals.geo_obscuration": "0.2",
    "beacon.pointing_error": '"300 urad"',
    "beacon.transmit_optics_loss": '"1 dB"',
    "beacon.receive_optics_loss": '"1 dB"',
    "beacon.required_power": '"10 pW"',
    "channel.zenith_transmission": "0.8",
    "channel.elevation": '"40 deg"',
    "channel.turbulence.ground_strength": "1.2e-14",
    "channel.turbulence.wind_rms": '"19 m/s"',
    "answer.pointing_error": '"40 urad"',
    "answer.receive_optics_loss": '"1 dB"',
    "answer.required_power": '"10 pW"',
    "communication.transmit_power": '"1 W"',
    "communication.strehl": "0.9",
    "communication.pointing_error": '"5 urad"',
    "communication.distance": '"40000 km"',
    "communication.transmit_optics_loss": '"1 dB"',
    "communication.receive_optics_loss": '"2 dB"',
    "communication.receiver_sensitivity": '"200 photon/bit"',
    "communication.implementation_loss": '"1 dB"',
    "communication.receiver.order": "16",
    "communication.receiver.efficiency": "0.5",
    "communication.receiver.dark_count_rate": '"10000 1/s"',
    "communication.receiver.background_power": '"0.1 pW"',
    "communication.receiver.noise_figure": '"5 dB"',
    "communication.receiver.amplifier_gain": '"35 dB"',
    "communication.receiver.optical_bandwidth": '"20 GHz"',
    "communication.receiver.extinction_ratio": '"15 dB"',
    "communication.receiver.bit_error_ratio": "1e-6",
    "communication.receiver.code_gain": '"2 dB"',
    "communication.receiver.code_rate": "0.5",
    "communication.receiver.bandwidth": '"6 GHz"',
    "jitter.bandwidth": '"10 Hz"',
    "requirement.pointing_error": '"10 urad"',
}
"""What is given where a preset says "unknown": any value, for the sums to go through."""


@functools.cache
def listed_presets() -> Any:
    """What the command line lists, asked once for all presets, and so inside of none of them."""
    of_case, warm.inside_of[:] = warm.inside_of[:], []
    with tempfile.TemporaryDirectory(prefix="microrad-numbers-") as folder:
        listed = Place(Path(folder)).json("presets")
    warm.inside_of[:] = of_case
    return listed


def preset(name: str) -> Callable[[Place], Any]:
    """The budget of a preset with `GIVEN` in its gaps, and which gaps it has."""

    def measure(place: Place) -> Any:
        (listed,) = (each for each in listed_presets() if each["name"] == name)
        place.run("init", "--preset", name, "preset.toml")
        text = filled((place.folder / "preset.toml").read_text(encoding="utf-8"))
        return {"unknown": listed["unknown"], "budget": place.json("budget", place.write("given.toml", text))}

    return measure


def filled(text: str) -> str:
    """A preset's text with `GIVEN` in the place of what is unknown."""
    table, lines = "", []
    for line in text.splitlines():
        if heading := re.match(r"\[(.+)\]", line):
            table = heading[1]
        if gap := re.match(r'(\w+) = "unknown"', line):
            line = f"{gap[1]} = {GIVEN[f'{table}.{gap[1]}']}"  # noqa: PLW2901
        lines.append(line)
    return "\n".join(lines) + "\n"


# ------------------------------------------------------------------------------------------------------------- gallery
def gallery_paper(place: Place) -> Any:
    """A larger aperture, at the pointing error of the budget and at that of the loop."""
    place.write("larger.toml", changed(MISSION, ('leo_aperture = "5 cm"', 'leo_aperture = "6 cm"')))
    return {
        "budgeted": place.json("budget", "larger.toml"),
        "left": place.json("budget", "larger.toml", "--pointing-error", "12.1 urad"),
    }


def gallery_lab(place: Place) -> Any:
    """A lab's plan, played and identified."""
    place.run("bench", GALLERY / "lab-plan.toml", "--output", "lab")
    return place.json("identify", "lab", "--mirror-file", "lab-mirror.toml")


def gallery_mirrors(place: Place) -> Any:
    """Three mirrors under the mission's vibration, in few and short runs, with a slow PID that is stable on each."""
    shorter = (
        ('\nproportional = "1 V/mrad"', '\nproportional = "0.01 V/mrad"'),
        ('\nintegral = "16000 V/(mrad s)"', '\nintegral = "160 V/(mrad s)"'),
        ("\nruns = 64 ", "\nruns = 16 "),
        ('\nduration = "2 s"', '\nduration = "0.5 s"'),
        ('\nsettle = "0.5 s"', '\nsettle = "0.1 s"'),
    )
    short = changed(NO_DAY, *shorter)
    place.write("short.toml", short)
    found = {}
    for mirror in ("short-stroke", "medium-stroke", "long-stroke"):
        summary = place.json("run", "short.toml", "--mirror", GALLERY / f"{mirror}.toml", "--output", mirror)
        found[mirror] = summary["fine_pointing"]
    return found


def gallery_crosslink(place: Place) -> Any:
    """A link between two CubeSats, its contacts, and its beam made narrower."""
    text = (GALLERY / "crosslink.toml").read_text(encoding="utf-8")
    place.write("crosslink.toml", text)
    found = {"budget": place.json("budget", "crosslink.toml"), "contacts": place.json("contacts", "crosslink.toml")}
    for radius_mm in (4, 16, 20):
        beam = ('radius = "8.138 mm"', f'radius = "{radius_mm} mm"')
        aperture = ('leo_aperture = "4 cm"', f'leo_aperture = "{5 * radius_mm} mm"')
        place.write("wider.toml", changed(text, beam, aperture))
        wider = place.json("budget", "wider.toml")
        found[f"radius {radius_mm} mm"] = {name: wider[name] for name in ("largest_data_rate_bit_s", "under_jitter")}
    return found


def gallery_constellation(place: Place) -> Any:
    """A day of twelve satellites, with one thing changed at a time."""
    changes = {
        "24 satellites": ("satellites = 12 ", "satellites = 24 "),
        "two terminals": ("terminals = 1 ", "terminals = 2 "),
        "sessions of 20 min": ('session = "10 min"', 'session = "20 min"'),
        "rates in steps": ("# rates = [", "rates = ["),
    }
    found = {}
    for name, change in changes.items():
        place.write("other.toml", changed(MISSION, change))
        found[name] = place.json("constellation", "other.toml")
    return found


# ------------------------------------------------------------------------------------------------------------- mirrors
def bouc_wen(place: Place) -> Any:
    """The mission's own mirror."""
    return _driven(place)


def prandtl_ishlinskii(place: Place) -> Any:
    """The play operators of a mirror of the gallery before the mission's linear part, which its loop is stable with."""
    text = (GALLERY / "medium-stroke.toml").read_text(encoding="utf-8")
    linear = re.split(r"(?m)^(?=\[)|^# -", MISSION.partition("[mirror.linear]")[2])[0]
    return _driven(place, "--mirror", place.write("mirror.toml", f"{without(text, 'linear')}\n[linear]{linear}"))


def _driven(place: Place, *other: str) -> Any:
    """Loops of a mirror on the mission's drives, its sines under the loop, and its modes as they are exported."""
    place.run("run", place.write("loops.toml", LOOPS), "--output", "study", *other)
    results = arrays(place.folder / "study" / "results.nc")
    return {
        "results": {name: found for name, found in results.items() if not name.endswith((".time", ".reference"))},
        "export": place.json("export", "matrices", "leo-geo.toml", *other),
    }


# ------------------------------------------------------------------------------------------------------ identification
SUFFIXES = {
    "csv": "csv",
    "lvm": "lvm",
    "tdms": "tdms",
    "mat": "mat",
    "mat73": "mat",
    "npz": "npz",
    "hdf5": "h5",
}
"""Formats that the virtual bench writes, and how the names of their files end."""


def identification(form: str) -> Callable[[Place], Any]:
    """The paper's loop of 100 Hz from a file of one format, fitted without dynamics."""

    def measure(place: Place) -> Any:
        loop = _loop(place, form)
        return place.json("identify", loop, "--input", "drive", "--output", "angle", "--static")

    return measure


def identification_npy(place: Place) -> Any:
    """The same from a bare array, which says no rate and no unit."""
    with np.load(_loop(place, "npz")) as file:
        np.save(place.folder / "loop.npy", np.column_stack([file["drive"], file["angle"]]))
    stated = ("--rate", "50 kHz", "--input-unit", "V", "--output-unit", "mrad")
    return place.json("identify", "loop.npy", "--input", "data[0]", "--output", "data[1]", "--static", *stated)


def _loop(place: Place, form: str) -> Path:
    """The file of the paper's loop of 100 Hz, played by the virtual bench."""
    plan = changed(
        without(EXPERIMENT, r"excitation\.chirp"),
        ('formats = ["tdms"]', f'formats = ["{form}"]'),
        ('frequencies = ["60 Hz", "80 Hz", "100 Hz"]', 'frequencies = ["100 Hz"]'),
    )
    place.run("bench", place.write("plan.toml", plan), "--output", "lab")
    (file,) = (place.folder / "lab").glob(f"loop*.{SUFFIXES[form]}")
    return file


def identification_whole(place: Place) -> Any:
    """The paper's experiment at a fifth of its rate, chirp and loops, all models."""
    slow = changed(EXPERIMENT, ('rate = "50 kHz"', 'rate = "10 kHz"'), ('stop = "5 kHz"', 'stop = "1 kHz"'))
    place.run("bench", place.write("plan.toml", slow), "--output", "lab")
    return place.json("identify", "lab", "--mirror-file", "lab-mirror.toml")


# ----------------------------------------------------------------------------------------------- campaigns and exports
def campaign(rows: int, controller: str) -> Callable[[Place], Any]:
    """The campaign that `campaign init` writes, with so many rows, and the table of these."""

    def measure(place: Place) -> Any:
        place.run("campaign", "init", "campaign.toml")
        text = (place.folder / "campaign.toml").read_text(encoding="utf-8")
        loop = ('controller = "LQG"', f'controller = "{controller}"')
        sensor = (  # the paper's mission states its noise, that of `init` what its quad cell is made of
            ("optical_sensor.quad_cell.thermal_noise", "optical_sensor.noise"),
            ("0.02 pA/sqrt(Hz)", "0.5 urad"),
            ("0.2 pA/sqrt(Hz)", "2 urad"),
        )
        place.write("campaign.toml", changed(text, ("\nruns = 128 ", f"\nruns = {rows} "), loop, *sensor))
        summary = place.json("campaign", "run", "campaign.toml")
        for cell in summary["cells"]:
            cell["tail"] = cell["tail"]["wanted"]  # its curve has a point for each level that a run has reached
        place.run("campaign", "export", "campaign.ledger", "rows.csv")
        return {"summary": summary, "rows": columns(place.folder / "rows.csv")}

    return measure


def export_c(place: Place) -> Any:
    """Flight code on the recorded run of its loop, compiled here once more by the plain command."""
    if shutil.which("cc") is None:
        raise SkippedError("there is no C compiler (cc)")
    summary = place.json("export", "c", "leo-geo.toml", "--name", "flight", "--output", "flight")
    code = place.folder / "flight"
    sources = ["flight/flight.c", "flight/flight_bench.c"]
    place.program("cc", "-std=c99", "-O2", "-o", "flight/bench", *sources, "-lm")
    said = place.program("flight/bench", "flight/vectors.csv", 1)
    counted = dict(line.split() for line in said.splitlines())
    return {
        "summary": summary,
        "compiled": {name: json.loads(value) for name, value in counted.items()},
        "trace": columns(code / "vectors.csv"),
    }


def export_matrices(place: Place) -> Any:
    """Models of the mirror and of the loop around it."""
    return place.json("export", "matrices", "leo-geo.toml", "--controller", "PI + inverse")


# ---------------------------------------------------------------------------------------------------------------- list
PRESETS = (
    *("click", "crosslink", "dsoc", "ground-downlink", "leo-hicali", "llcd", "oicets-artemis", "opals"),
    *("paper", "qpsk-crosslink", "sda-crosslink", "sentinel1-edrs", "spot4-artemis", "tbird"),
)

CASES: Mapping[str, Case] = {
    "budget": Case(budget),
    "campaign": Case(campaign(256, "LQG"), quick=False),
    "campaign-few": Case(campaign(8, "PI"), quick=False),
    "constellation": Case(command("constellation")),
    "contacts": Case(command("contacts")),
    "design": Case(command("design")),
    "export-c": Case(export_c),
    "export-matrices": Case(export_matrices),
    "gallery-constellation": Case(gallery_constellation, quick=False),
    "gallery-crosslink": Case(gallery_crosslink, quick=False),
    "gallery-lab": Case(gallery_lab, quick=False),
    "gallery-mirrors": Case(gallery_mirrors, quick=False),
    "gallery-paper": Case(gallery_paper),
    **{f"identify-{form}": Case(identification(form), quick=form == "tdms") for form in SUFFIXES},
    "identify-npy": Case(identification_npy, quick=False),
    "identify-whole": Case(identification_whole, quick=False),
    "mirror-bouc-wen": Case(bouc_wen, quick=False),
    "mirror-prandtl-ishlinskii": Case(prandtl_ishlinskii),
    "mission": Case(mission, quick=False),
    "mission-results": Case(mission_results, quick=False),
    "mission-shipped": Case(mission_shipped, quick=False),
    **{f"preset-{name}": Case(preset(name)) for name in PRESETS},
    "standard": Case(standard),
}
"""All cases; a file reference/NAME.json each."""


def measured(case: Case) -> Any:
    """What a case finds, in a temporary folder of its own."""
    with tempfile.TemporaryDirectory(prefix="microrad-numbers-") as folder:
        return case.measure(Place(Path(folder)))
