"""Co-simulation units (FMU, the Functional Mock-up Interface 2.0 and 3.0) of a mirror or its closed loop, C inside.

Source: Modelica Association, "Functional Mock-up Interface for Model Exchange and Co-Simulation", 2.0.4 (2022) and
"Functional Mock-up Interface Specification", 3.0.1 (2023).
"""

import hashlib
import io
import platform
import subprocess
import sys
import uuid
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass
from importlib.metadata import version as version_of
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np

from microrad.core import kernels
from microrad.core.folder import scratch, write_whole
from microrad.export.flight.build import FLAGS, TIME_LIMIT_S, compiler, compiler_words
from microrad.export.flight.c_code import flight_code
from microrad.export.fmi.description import Version, exponent, model_description, plant_of, variables
from microrad.export.identifiers import identifier
from microrad.export.linear_part.sections import sections
from microrad.export.records import GAUGE, OPTICAL_ERROR, READING, REFERENCE, ExportError, LoopUnit, PlantUnit
from microrad.export.templating import render

SHARED = (*FLAGS, "-fPIC", "-shared", "-fvisibility=hidden")
"""What the library of a unit is compiled with."""

HEADERS: Mapping[str, tuple[str, ...]] = {
    "2.0": ("fmi2Functions.h", "fmi2FunctionTypes.h", "fmi2TypesPlatform.h"),
    "3.0": ("fmi3Functions.h", "fmi3FunctionTypes.h", "fmi3PlatformTypes.h"),
}
"""Headers of the standard, by version."""

LONGEST_NAME = 27
"""Characters of a unit's name: the controller inside has the name with an ending, in at most 31."""

EPOCH = (1980, 1, 1, 0, 0, 0)
"""Time stamp of all files in the archive, so that the same unit is the same file."""


@dataclass(frozen=True, slots=True)
class WrittenUnit:
    """A unit that was written. ``platform`` is what it holds a library for; None without a C compiler: sources alone.

    ``guid`` belongs to its contents.
    """

    path: Path
    version: Version
    guid: str
    platform: str | None

    @property
    def words(self) -> str:
        """What the unit holds, in a sentence."""
        if self.platform is None:
            return (
                f"{self.path}: FMI {self.version}, sources alone: no C compiler was found; compile it where it is used"
            )
        return f"{self.path}: FMI {self.version}, sources and a library for {self.platform}"


def write_unit(unit: PlantUnit | LoopUnit, path: Path, version: Version, name: str) -> WrittenUnit:
    """Write a unit for co-simulation to ``path``, usually "{name}.fmu": whole or not at all. A file there is replaced.

    Plant: inputs command_v (V from the bias, held over the communication step); outputs mirror_rad, line_of_sight_rad,
    drive_v and counters. Loop: inputs reference_rad and disturbance_rad (rad, taken at the begin of the communication
    step and held over it); outputs error_rad, line_of_sight_rad, mirror_rad, command_v, drive_v and counters. A mirror
    whose outputs are displacements has mirror_m. Version 2.0 knows no arrays: their elements are variables by
    themselves, ``command_v[1]``. A communication step is a whole number of plant steps; another one is an error of the
    call, and changes nothing. Parameters act until the initialisation ends.

    The library inside is compiled here, if there is a C compiler. The same unit gives the same file.

    Args:
        unit: The mirror with its amplifier, or a closed loop.
        path: The file to write.
        version: Version of the interface, "2.0" or "3.0".
        name: What the unit calls itself, an identifier of C.

    Raises:
        ExportError: Another version; a name that is no identifier or too long; a controller that cannot be exported
            (see `sections`); a compiler that fails.
    """
    if version not in HEADERS:
        raise ExportError(f"FMI {version!r} is not written here: choose {' or '.join(HEADERS)}")
    if len(identifier(name)) > LONGEST_NAME:
        raise ExportError(
            f"the name {name!r} of a co-simulation unit has {len(name)} characters: at most {LONGEST_NAME}, since what "
            "is inside has the name with an ending; take a shorter one"
        )
    made, guid = _texts(unit, version, name)
    contents = {file: text.encode() for file, text in made.items()}
    found = _library(made, version, name) if compiler() is not None else None
    if found is not None:
        contents[f"binaries/{_platform(version)}/{name}{_ending()}"] = found
    write_whole(path, _archive(contents))
    return WrittenUnit(path, version, guid, None if found is None else _platform(version))


def _texts(unit: PlantUnit | LoopUnit, version: Version, name: str) -> tuple[dict[str, str], str]:
    """All files but the library, and the GUID, which stands for what is in them."""
    code = unit_code(unit, version, name)
    adapter = f"fmi{version[0]}.c"
    compiled = (*(file for file in code if file.endswith(".c")), adapter)

    def around(guid: str) -> dict[str, str]:
        return {
            "modelDescription.xml": model_description(unit, version, name, guid, compiled),
            f"sources/{adapter}": render(f"{adapter}.j2", unit=f"{name}_unit", guid=guid),
        }

    rest = {f"sources/{file}": text for file, text in code.items()}
    headers = files("microrad.export.fmi") / "headers"
    rest |= {f"sources/{file}": (headers / file).read_text(encoding="utf-8") for file in HEADERS[version]}
    rest["documentation/licenses/license.txt"] = render("fmi_licence.txt.j2")
    if version == "3.0":
        rest["sources/buildDescription.xml"] = render("build_description.xml.j2", name=name, compiled=compiled)
    digest = hashlib.sha256()
    for file, text in sorted({**rest, **around("")}.items()):
        digest.update(f"{file}\n{len(text)}\n{text}".encode())
    guid = f"{{{uuid.UUID(bytes=digest.digest()[:16], version=5)}}}"
    return {**around(guid), **rest}, guid


# -------------------------------------------------------------------------------------------------------------- sources
def unit_code(unit: PlantUnit | LoopUnit, version: Version, name: str) -> dict[str, str]:
    """The C of a unit without the functions of the standard, as texts by file name.

    Args:
        unit: The mirror with its amplifier, or a closed loop.
        version: Version of the interface, which says what its variables are.
        name: What the unit calls itself, an identifier of C.

    Raises:
        ExportError: For a controller that cannot be exported (see `sections`), or that reads what a loop does not
            measure.
    """
    plant, loop, control = f"{name}_plant", f"{name}_loop", f"{name}_ctl"
    code = {f"{plant}_hysteresis.h": render("hysteresis.h.j2", name=plant, precision="double")}
    values = _plant_values(plant_of(unit))
    code |= {f"{plant}.{kind}": render(f"plant.{kind}.j2", name=plant, **values) for kind in ("h", "c")}
    if isinstance(unit, LoopUnit):
        flight = flight_code(unit.controller, sections(unit.controller), control, "double")
        code |= {file: text for file, text in flight.items() if file.endswith((".h", ".c")) and "_bench" not in file}
        values = {"name": loop, "plant": plant, "control": control, **_loop_values(unit)}
        code |= {f"{loop}.{kind}": render(f"loop.{kind}.j2", **values) for kind in ("h", "c")}
    listed = variables(unit, version)
    shown = {
        "name": f"{name}_unit",
        "plant": plant,
        "loop": loop if isinstance(unit, LoopUnit) else "",
        "of": plant_of(unit),
        "variables": listed,
        "constants": [number for each in listed if each.constant for number in each.start or ()],
    }
    return code | {f"{name}_unit.{kind}": render(f"fmi_unit.{kind}.j2", **shown) for kind in ("h", "c")}


def _plant_values(unit: PlantUnit) -> dict[str, Any]:
    """What the templates of a plant are filled with, but for its name."""
    p, count = unit.plant, np.diff(unit.plant.rest.start.astype(int))
    row = np.repeat(np.arange(count.size), count)
    return {
        "of": unit,
        "p": p,
        "version": version_of("microrad"),
        "slew_v_s": unit.slew_step_v / p.step_s,
        "states": p.diagonal.size if len(p.states) else 0,
        "elements": len(p.elements) + len(p.operators),
        "rest": [(int(i), int(j), float(v)) for i, j, v in zip(row, p.rest.column, p.rest.value, strict=True)],
        "bouc_wen": [row[: kernels.POWER] for row in p.bouc_wen],
        "exponent": np.array([exponent(row) for row in p.bouc_wen]),
        "operator": list(p.operator),
        "polynomial": p.operator[:, 2:5] if np.isfinite(p.operator[:, 5]).any() else None,
    }


def _loop_values(unit: LoopUnit) -> dict[str, Any]:
    """What the templates of a loop are filled with. Raises ExportError for an input that no sensor delivers."""
    sources = {
        OPTICAL_ERROR: "loop->reading_rad",
        GAUGE: "gauge_rad",
        READING: "line_of_sight_rad",
        REFERENCE: "reference_rad",
    }
    names = [each.name for each in unit.controller.inputs]
    if unknown := [each for each in names if each not in sources]:
        raise ExportError(
            f"controller {unit.controller.name!r} reads {', '.join(unknown)}, which a loop does not measure: it has "
            f"{', '.join(sources)}"
        )
    return {
        "of": unit,
        "version": version_of("microrad"),
        "field_of_view_rad2": min(unit.field_of_view_rad**2, sys.float_info.max),
        "optical": OPTICAL_ERROR in names,
        "gauge": GAUGE in names,
        "reading": READING in names,
        "reference": REFERENCE in names,
        "arguments": [sources[each] for each in names],
    }


# ------------------------------------------------------------------------------------------------- library and archive
def _platform(version: Version) -> str:
    """The folder of libraries for this machine, as the standard calls it."""
    machine = platform.machine().lower()
    wide = sys.maxsize > 2**32
    system = {"win32": "windows", "cygwin": "windows", "darwin": "darwin"}.get(sys.platform, "linux")
    if version == "2.0":
        return {"windows": "win"}.get(system, system) + ("64" if wide else "32")
    kind = "aarch64" if machine in ("aarch64", "arm64") else "x86_64" if wide else "x86"
    if kind != "aarch64" and machine not in ("x86_64", "amd64", "i386", "i686", "x86"):
        kind = machine
    return f"{kind}-{system}"


def _ending() -> str:
    return {"win32": ".dll", "cygwin": ".dll", "darwin": ".dylib"}.get(sys.platform, ".so")


def _library(texts: Mapping[str, str], version: Version, name: str) -> bytes:
    """The compiled library of a unit's sources."""
    with scratch("fmu") as folder:
        for file, text in texts.items():
            if file.startswith("sources/"):
                (folder / Path(file).name).write_text(text, encoding="utf-8", newline="\n")
        sources = sorted(Path(file).name for file in texts if file.endswith(".c"))
        target = f"{name}{_ending()}"
        flags = [flag for flag in SHARED if flag != "-fPIC" or _ending() != ".dll"]
        command = [*compiler_words(), *flags, "-o", target, *sources, "-lm"]
        try:
            done = subprocess.run(
                command, cwd=folder, capture_output=True, text=True, errors="replace", timeout=TIME_LIMIT_S, check=False
            )
        except (OSError, subprocess.TimeoutExpired) as error:
            raise ExportError(
                f"the C compiler {command[0]!r} cannot compile the FMI {version} unit: {error}"
            ) from error
        if done.returncode != 0:
            first = "\n  ".join(done.stderr.splitlines()[:12])
            raise ExportError(f"the C compiler {command[0]!r} refuses the FMI {version} unit {name!r}:\n  {first}")
        return (folder / target).read_bytes()


def _archive(contents: Mapping[str, bytes]) -> bytes:
    """A zip file with the model description first, that depends on nothing but its contents."""
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
        for name in sorted(contents, key=lambda each: (each != "modelDescription.xml", each)):
            entry = zipfile.ZipInfo(name, EPOCH)
            entry.create_system = 3  # permissions as on POSIX, wherever it is written
            entry.external_attr = (0o100755 if name.startswith("binaries/") else 0o100644) << 16
            archive.writestr(entry, contents[name], zipfile.ZIP_DEFLATED)
    return file.getvalue()
