"""Exports as commands to copy and as lines of Python to copy."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from microrad.studio.commands_pieces import (
    as_path,
    joined,
    mission_call,
    new_file,
    option,
    path_argument,
    target_options,
)


@dataclass(frozen=True, slots=True)
class ExportCode:
    """A controller as C99 for a flight computer, into a folder."""

    file: Path
    controller: str
    output: Path
    precision: Literal["double", "single", "fixed"] = "double"
    mirror: Path | None = None
    overwrite: bool = False

    @property
    def arguments(self) -> tuple[str, ...]:
        """What follows `microrad` on the command line."""
        how = (*option("--controller", self.controller), *option("--precision", self.precision))
        return (
            "export",
            "c",
            path_argument(self.file),
            *how,
            *target_options(self.output, self.mirror, self.overwrite),
        )

    @property
    def python(self) -> str:
        """Lines of Python that do the same."""
        how = f"precision={self.precision!r}, overwrite={self.overwrite}"
        return joined(
            "from pathlib import Path",
            "",
            "from microrad import load_mission",
            "from microrad.export import choice",
            "from microrad.export.flight import write",
            "",
            f"chosen = choice.choose({mission_call(self.file, self.mirror)}, {self.controller!r})",
            f"found = write.export_flight(chosen, {as_path(self.output)}, {how})",
            "print(write.report_text(found))",
        )

    @property
    def results(self) -> tuple[str, ...]:
        """The folder."""
        return (str(self.output),)


@dataclass(frozen=True, slots=True)
class ExportUnit:
    """The mirror with the amplifier of a `loop`, or the closed loop of a `controller`, as a co-simulation unit (FMI).

    `name` is what the unit calls itself, an identifier of C.
    """

    file: Path
    output: Path
    name: str = "mirror"
    controller: str | None = None
    loop: Literal["fine_pointing", "control"] = "control"
    fmi: Literal["2.0", "3.0"] = "2.0"
    mirror: Path | None = None
    overwrite: bool = False

    @property
    def arguments(self) -> tuple[str, ...]:
        """What follows `microrad` on the command line."""
        of = option("--loop", self.loop) if self.controller is None else option("--controller", self.controller)
        how = (*of, *option("--fmi", self.fmi), *option("--name", self.name))
        return (
            "export",
            "fmu",
            path_argument(self.file),
            *how,
            *target_options(self.output, self.mirror, self.overwrite),
        )

    @property
    def python(self) -> str:
        """Lines of Python that do the same."""
        of = f"choice.plant_unit(mission, {self.loop!r})"
        if self.controller is not None:
            of = f"choice.loop_unit(choice.choose(mission, {self.controller!r}))"
        return joined(
            "from pathlib import Path",
            "",
            "from microrad import load_mission",
            "from microrad.export import choice",
            "from microrad.export.fmi.fmu import write_unit",
            "",
            *new_file(self.output, self.overwrite),
            f"mission = {mission_call(self.file, self.mirror)}",
            f"print(write_unit({of}, path, {self.fmi!r}, {self.name!r}).words)",
        )

    @property
    def results(self) -> tuple[str, ...]:
        """The unit."""
        return (str(self.output),)


@dataclass(frozen=True, slots=True)
class ExportMatrices:
    """Linear models of the mirror, and of a controller with its loop, as a file of MATLAB."""

    file: Path
    output: Path
    controller: str | None = None
    mirror: Path | None = None
    overwrite: bool = False

    @property
    def arguments(self) -> tuple[str, ...]:
        """What follows `microrad` on the command line."""
        of = option("--controller", self.controller)
        return (
            "export",
            "matrices",
            path_argument(self.file),
            *of,
            *target_options(self.output, self.mirror, self.overwrite),
        )

    @property
    def python(self) -> str:
        """Lines of Python that do the same."""
        of = "mission" if self.controller is None else f"choice.choose(mission, {self.controller!r})"
        return joined(
            "from pathlib import Path",
            "",
            "from microrad import load_mission",
            "from microrad.export import choice, matrices"
            if self.controller
            else "from microrad.export import matrices",
            "",
            *new_file(self.output, self.overwrite),
            f"mission = {mission_call(self.file, self.mirror)}",
            f"found = matrices.models({of})",
            "matrices.write_mat(found, path)",
            "print(', '.join(each.name for each in found))",
        )

    @property
    def results(self) -> tuple[str, ...]:
        """The file."""
        return (str(self.output),)
