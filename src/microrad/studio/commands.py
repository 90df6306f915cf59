"""What is done in the studio as a command to copy and as lines of Python to copy; both give the same numbers.

Each record is one thing to do. Its `arguments` are those of microrad, for a job, too; `command` joins them to a line
for a shell. Its `python` runs by itself, in the same folder. `results` are the files that it writes.
"""

from __future__ import annotations

import shlex
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from microrad.studio.commands_identify import Identify
from microrad.studio.commands_pieces import WIDTH, as_path, flag, joined, mission_call, option, path_argument, path_text

__all__ = [
    "Action",
    "Budget",
    "CampaignResume",
    "CampaignRun",
    "Contacts",
    "Design",
    "Identify",
    "Run",
    "command",
]


class Action(Protocol):
    """Something done in the studio."""

    @property
    def arguments(self) -> tuple[str, ...]:
        """What follows `microrad` on the command line."""

    @property
    def python(self) -> str:
        """Lines of Python that do the same."""

    @property
    def results(self) -> tuple[str, ...]:
        """Files and folders that it writes, seen from the working folder."""


def command(action: Action) -> str:
    """The line for a shell."""
    return shlex.join(("microrad", *action.arguments))


# ------------------------------------------------------------------------------------------------------ from a mission
@dataclass(frozen=True, slots=True)
class Budget:
    """The link budgets, as they are or with another data rate or pointing error, or with the rate solved for."""

    file: Path
    data_rate: str | None = None
    pointing_error: str | None = None
    results: tuple[str, ...] = ()

    @property
    def arguments(self) -> tuple[str, ...]:
        """What follows `microrad` on the command line."""
        return (
            "budget",
            path_argument(self.file),
            *option("--data-rate", self.data_rate),
            *option("--pointing-error", self.pointing_error),
        )

    @property
    def python(self) -> str:
        """Lines of Python that do the same."""
        if self.data_rate is None and self.pointing_error is None:
            return joined(
                "from microrad import load_link, run_link_study",
                "from microrad.report.links.budgets import links_text",
                "",
                f"study = run_link_study(load_link({path_text(self.file)}))",
                f"print(links_text(study, {WIDTH}))",
            )
        return joined(
            "from dataclasses import replace",
            "",
            "from microrad import load_link, parse_quantity, run_link_study",
            "from microrad.mission.model import Source",
            "from microrad.report.links.budgets import links_text",
            "",
            f"file = load_link({path_text(self.file)})",
            "tables, sources = {}, dict(file.sources)",
            *self._changes(),
            "file = replace(file, mission=file.mission.model_copy(update=tables), sources=sources)",
            f"print(links_text(run_link_study(file), {WIDTH}))",
        )

    def _changes(self) -> Iterable[str]:
        """Lines that put what was asked for in place of the mission's values."""
        rate, values = self.data_rate, []
        if rate is not None:
            read = "float('nan')" if rate == "largest" else f"parse_quantity({rate!r}, 'bit/s')"  # nan is solved for
            values.append(f"'data_rate_bit_s': {read}")
            yield f"sources['communication.data_rate'] = Source(0, 'command line', {rate!r})"
        if self.pointing_error is not None:
            values.append(f"'pointing_error_rad': parse_quantity({self.pointing_error!r}, 'rad')")
            yield f"sources['communication.pointing_error'] = Source(0, 'command line', {self.pointing_error!r})"
        yield f"tables['communication'] = file.mission.communication.model_copy(update={{{', '.join(values)}}})"


@dataclass(frozen=True, slots=True)
class Contacts:
    """Contacts with the relay and the ground, and what they deliver."""

    file: Path
    results: tuple[str, ...] = ()

    @property
    def arguments(self) -> tuple[str, ...]:
        """What follows `microrad` on the command line."""
        return ("contacts", path_argument(self.file))

    @property
    def python(self) -> str:
        """Lines of Python that do the same."""
        return joined(
            "from microrad import load_link, run_day_study, run_link_study",
            "from microrad.report.day.text import day_text",
            "",
            f"day = run_day_study(run_link_study(load_link({path_text(self.file)})))",
            f"print(day_text(day, {WIDTH}))",
        )


@dataclass(frozen=True, slots=True)
class Design:
    """The controllers of the fine-pointing loop."""

    file: Path
    mirror: Path | None = None
    results: tuple[str, ...] = ()

    @property
    def arguments(self) -> tuple[str, ...]:
        """What follows `microrad` on the command line."""
        return ("design", path_argument(self.file), *option("--mirror", self.mirror))

    @property
    def python(self) -> str:
        """Lines of Python that do the same."""
        return joined(
            "from microrad import load_mission, mirror",
            "from microrad.link.tracking_light import tracking_light_w",
            "from microrad.loop import fine_pointing",
            "",
            f"mission = {mission_call(self.file, self.mirror)}",
            "scene = fine_pointing.scene(mission, mirror.of(mission.mission), tracking_light_w(mission))",
            "designs = fine_pointing.design(scene)",
            "for design, left in zip(designs, fine_pointing.outlook(scene, designs)):",
            "    linear_urad, simulated_urad = left.linear_rad * 1e6, left.simulated_rad * 1e6",
            "    margins = design.tuned.margins",
            "    print(f'{design.name:28} {linear_urad:9.3f} {simulated_urad:9.3f} µrad rms, linear and simulated,'",
            "          f' modulus margin {margins.modulus:.3f}')",
        )


@dataclass(frozen=True, slots=True)
class Run:
    """The whole study of a mission, into a folder."""

    file: Path
    output: Path
    mirror: Path | None = None
    overwrite: bool = False

    @property
    def arguments(self) -> tuple[str, ...]:
        """What follows `microrad` on the command line."""
        mirror, overwrite = option("--mirror", self.mirror), flag("--overwrite", self.overwrite)
        return ("run", path_argument(self.file), *option("--output", self.output), *mirror, *overwrite)

    @property
    def python(self) -> str:
        """Lines of Python that do the same."""
        return joined(
            "from pathlib import Path",
            "",
            "from microrad import load_mission, run_study, verdict_text, write_report",
            "",
            f"study = run_study({mission_call(self.file, self.mirror)})",
            f"write_report(study, {as_path(self.output)}, overwrite={self.overwrite})",
            "print(verdict_text(study))",
        )

    @property
    def results(self) -> tuple[str, ...]:
        """The report, its data and the manifest."""
        return tuple(str(self.output / name) for name in ("report.html", "results.nc", "manifest.json"))


# ----------------------------------------------------------------------------------------------------------- campaigns
@dataclass(frozen=True, slots=True)
class CampaignRun:
    """A campaign into a new ledger."""

    file: Path
    ledger: Path
    threads: int | None = None

    @property
    def arguments(self) -> tuple[str, ...]:
        """What follows `microrad` on the command line."""
        ledger, threads = option("--ledger", self.ledger), option("--threads", self.threads)
        return ("campaign", "run", path_argument(self.file), *ledger, *threads)

    @property
    def python(self) -> str:
        """Lines of Python that do the same."""
        begin = f"run_campaign({as_path(self.file)}, ledger, CampaignMeans(threads={self.threads}))"
        return _campaign(self.ledger, "run_campaign", begin)

    @property
    def results(self) -> tuple[str, ...]:
        """The ledger."""
        return (str(self.ledger),)


@dataclass(frozen=True, slots=True)
class CampaignResume:
    """A campaign that stopped, on to the results that it would have had."""

    ledger: Path
    threads: int | None = None

    @property
    def arguments(self) -> tuple[str, ...]:
        """What follows `microrad` on the command line."""
        return ("campaign", "resume", path_argument(self.ledger), *option("--threads", self.threads))

    @property
    def python(self) -> str:
        """Lines of Python that do the same."""
        go_on = f"resume_campaign(ledger, CampaignMeans(threads={self.threads}))"
        return _campaign(self.ledger, "resume_campaign", go_on)

    @property
    def results(self) -> tuple[str, ...]:
        """The ledger."""
        return (str(self.ledger),)


def _campaign(ledger: Path, name: str, call: str) -> str:
    return joined(
        "from pathlib import Path",
        "",
        f"from microrad import CampaignMeans, {name}, summarise_campaign",
        "from microrad.report.campaign.text import campaign_text",
        "",
        f"ledger = {as_path(ledger)}",
        call,
        f"print(campaign_text(summarise_campaign(ledger), {WIDTH}))",
    )
