"""What all checks read: the shipped mission, once as its text and once as the documents that commands print of it."""

import math
import tomllib
from collections.abc import Callable, Mapping
from functools import cached_property
from importlib import resources
from pathlib import Path
from typing import Any

from microrad.core.kept import NOTHING, Kept
from microrad.report.registry import flattened, stated_units, unit_of
from microrad.report.verification.evidence import Comparison

_KINDS: dict[str, dict[str, float]] = {
    "m": {"m": 1.0, "km": 1e3, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "nm": 1e-9},
    "rad": {"rad": 1.0, "mrad": 1e-3, "urad": 1e-6, "nrad": 1e-9, "deg": math.pi / 180.0},
    "W": {"W": 1.0, "mW": 1e-3, "uW": 1e-6, "nW": 1e-9, "pW": 1e-12},
    "s": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "min": 60.0, "h": 3600.0},
    "Hz": {"Hz": 1.0, "kHz": 1e3},
    "bit/s": {"bit/s": 1.0, "Mbit/s": 1e6, "Gbit/s": 1e9},
    "bit": {"GB": 8e9},
    "photon/bit": {"photon/bit": 1.0},
    "dB": {"dB": 1.0},
    "m/s": {"km/s": 1e3},
    "rad/s": {"deg/s": math.pi / 180.0},
    "A": {"nA": 1e-9},
    "A/W": {"A/W": 1.0},
    "A/sqrt(Hz)": {"pA/sqrt(Hz)": 1e-12},
    "V": {"V": 1.0, "mV": 1e-3},
    "V/s": {"V/s": 1.0},
    "rad/V": {"mrad/V": 1e-3},
    "s/V": {"s/V": 1.0},
    "1/V": {"1/V": 1.0},
    "V/rad": {"V/mrad": 1e3},
    "V/(rad s)": {"V/(mrad s)": 1e3},
}
"""A second table of units, by SI unit, which shares nothing with the one that reads missions."""
_FACTORS = {unit: factor for kind in _KINDS.values() for unit, factor in kind.items()}
_JITTER = """
[jitter]
bias = ["4 urad", "0 urad"]   # example
rms = ["6 urad", "6 urad"]    # example
bandwidth = "30 Hz"           # example
"""


def with_values(text: str, values: Mapping[str, str]) -> str:
    """A mission's text with other values, each as TOML has it, by dotted key.

    Args:
        text: The mission.
        values: What stands behind the sign of equality.

    Raises:
        KeyError: If the text has no line with such a key.
    """
    table, lines, left = "", text.splitlines(), dict(values)
    for place, line in enumerate(lines):
        if line.startswith("["):
            table = line.strip("[] ").partition("]")[0]
        key = f"{table}.{line.partition('=')[0].strip()}"
        if key in left:
            lines[place] = f"{line.partition('=')[0]}= {left.pop(key)}  # example"
    if left:
        raise KeyError(*left)
    return "\n".join(lines) + "\n"


class Given:
    """The shipped mission by its text alone: its values in SI units, by the second table of units."""

    def __init__(self, text: str) -> None:
        """The mission's text."""
        self._tables = tomllib.loads(text)

    def __call__(self, key: str) -> Any:
        """A value by its dotted key; text that is a value with a unit as a number."""
        found = self._stated(key)
        if isinstance(found, str):
            number, _, unit = found.partition(" ")
            return float(number) * _FACTORS[unit] if unit in _FACTORS else found
        return found

    def unit(self, key: str) -> str:
        """The SI unit of a value by its dotted key."""
        unit = str(self._stated(key)).partition(" ")[2]
        return next(si for si, kind in _KINDS.items() if unit in kind)

    def _stated(self, key: str) -> Any:
        found: Any = self._tables
        for part in key.split("."):
            found = found[part]
        return found


class Workspace:
    """Documents of the shipped mission, each made when a check asks for it and kept for the next."""

    def __init__(self, folder: Path, data: Path | None, parts: Kept = NOTHING) -> None:
        """A folder that may be written to, one with recordings, if there is one, and parts of studies to take again."""
        self.folder = folder
        self.data = data
        self._parts = parts
        self.mission_path = folder / "leo-geo.toml"
        self.take(resources.files("microrad.mission").joinpath("missions", "leo-geo.toml").read_text("utf-8"))

    def take(self, text: str) -> None:
        """Put another mission in place of the shipped one, before anything was computed of it."""
        self.text, self.given = text, Given(text)
        self.mission_path.write_text(text, encoding="utf-8")

    @cached_property
    def study(self) -> Any:
        """The whole study of the mission, computed anew."""
        from microrad.mission.file import load_mission
        from microrad.study.study import run_study

        return run_study(load_mission(self.mission_path), parts=self._parts)

    @cached_property
    def links(self) -> Any:
        """The links of the mission, without a loop."""
        from microrad.link.study import run_link_study
        from microrad.mission.file import load_link

        return run_link_study(load_link(self.mission_path))

    @cached_property
    def jittered(self) -> Any:
        """The shipped crosslink under a jitter of its own."""
        from microrad.link.study import run_link_study
        from microrad.mission.file import load_link
        from microrad.mission.presets import preset_text

        path = self.folder / "crosslink.toml"
        path.write_text(preset_text("crosslink") + _JITTER, encoding="utf-8")
        return run_link_study(load_link(path))

    @cached_property
    def documents(self) -> dict[str, dict[str, float]]:
        """What has been flattened so far."""
        return {}

    @cached_property
    def units(self) -> dict[str, dict[str, str]]:
        """Of the same documents the units that stand beside a number."""
        return {}

    def numbers(self, document: str) -> dict[str, float]:
        """The numbers of a document by their dotted names.

        Args:
            document: "budget", as `microrad budget --json` prints it; "jitter", the same of a crosslink under jitter;
                "run", as `microrad run --json` does; "standard", what "budget" has beside it with `--standard sda`.
        """
        if document not in self.documents:
            made = self._made(document)
            self.documents[document], self.units[document] = dict(flattened(made)), stated_units(made)
        return self.documents[document]

    def _made(self, document: str) -> Any:
        from microrad.link.compliance import compliance, standard
        from microrad.report.links.data import links_data
        from microrad.report.links.standard import standard_data
        from microrad.report.study.data import summary

        made: dict[str, Callable[[], Any]] = {
            "budget": lambda: links_data(self.links),
            "jitter": lambda: links_data(self.jittered),
            "run": lambda: summary(self.study),
            "standard": lambda: {"standard": standard_data(compliance(self.links, standard("sda")))},
        }
        return made[document]()

    def compared(self, document: str, name: str, expected: float, tolerance: float, basis: str) -> Comparison:
        """A comparison of a figure that a command prints.

        Args:
            document: Which command, as for `numbers`.
            name: Dotted name of the figure in it.
            expected: In the figure's unit.
            tolerance: In that unit.
            basis: Where the tolerance comes from.
        """
        obtained = self.numbers(document).get(name, math.nan)
        unit = self.units.get(document, {}).get(name, "") or unit_of(name)
        return Comparison(
            f"{document}.{name}", name.replace(".", ", "), float(expected), obtained, tolerance, unit, basis
        )
