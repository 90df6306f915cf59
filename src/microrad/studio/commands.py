"""What is done in the studio as a command to copy and as lines of Python to copy; both give the same numbers."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from microrad.core.folder import path_argument

_WIDTH = 80  # columns of a printed table that goes to a file, as the command line has them


@dataclass(frozen=True, slots=True)
class Action:
    """Something done in the studio: `arguments` of microrad, and `python` that does the same in the same folder.

    `title` is what a job of it is called, `results` are the files that it writes, seen from the working folder.
    """

    arguments: tuple[str, ...]
    python: str = ""
    title: str = ""
    results: tuple[str, ...] = ()

    @property
    def command(self) -> str:
        """The line for a shell."""
        return shlex.join(("microrad", *self.arguments))


# ------------------------------------------------------------------------------------------------------ from a mission
def budget(file: Path) -> Action:
    """The link budgets of a mission's file."""
    python = _joined(
        "from microrad.link.study import run_link_study",
        "from microrad.mission.file import load_link",
        "from microrad.report.links.budgets import links_text",
        "",
        f"study = run_link_study(load_link({str(file)!r}))",
        f"print(links_text(study, {_WIDTH}))",
    )
    return Action(("budget", path_argument(file)), python)


def contacts(file: Path) -> Action:
    """Contacts with the relay and the ground, and what they deliver."""
    python = _joined(
        "from microrad.link.study import run_link_study",
        "from microrad.mission.file import load_link",
        "from microrad.orbit.day import run_day_study",
        "from microrad.report.day.page import day_text",
        "",
        f"day = run_day_study(run_link_study(load_link({str(file)!r})))",
        f"print(day_text(day, {_WIDTH}))",
    )
    return Action(("contacts", path_argument(file)), python)


def design(file: Path) -> Action:
    """The controllers of the fine-pointing loop."""
    python = _joined(
        "from microrad import load_mission, mirror",
        "from microrad.link import arrival_of, tracking_light_w",
        "from microrad.loop import controller_study",
        "",
        f"mission = load_mission({str(file)!r})",
        "light = tracking_light_w(mission), arrival_of(mission)",
        "scene = controller_study.scene(mission, mirror.of(mission.mission), *light)",
        "designs = controller_study.design(scene)",
        "for design, left in zip(designs, controller_study.outlook(scene, designs)):",
        "    linear_urad, simulated_urad = left.linear_rad * 1e6, left.simulated_rad * 1e6",
        "    margins = design.tuned.margins",
        "    print(f'{design.name:28} {linear_urad:9.3f} {simulated_urad:9.3f} µrad rms, linear and simulated,'",
        "          f' modulus margin {margins.modulus:.3f}')",
    )
    return Action(("design", path_argument(file)), python)


def study(file: Path, folder: Path) -> Action:
    """The whole study of a mission's file, with its report, its data and the manifest in a new folder.

    Args:
        file: the mission's file, seen from the working folder.
        folder: the new folder.
    """
    python = _joined(
        "from pathlib import Path",
        "",
        "from microrad import load_mission, run_study, write_report",
        "from microrad.report import verdict_text",
        "",
        f"study = run_study(load_mission({str(file)!r}))",
        f"write_report(study, {_path(folder)})",
        "print(verdict_text(study))",
    )
    results = tuple(str(folder / name) for name in ("report.html", "results.nc", "manifest.json"))
    return Action(("run", path_argument(file), *_option("--output", folder)), python, f"Study of {file}", results)


# ----------------------------------------------------------------------------------------------------------- campaigns
def campaign(file: Path, ledger: Path) -> Action:
    """The campaign of a file into a new ledger.

    Args:
        file: the campaign's file, seen from the working folder.
        ledger: the new ledger.
    """
    python = _campaign(ledger, "run_campaign", f"{_path(file)}, ledger")
    arguments = ("campaign", "run", path_argument(file), *_option("--ledger", ledger))
    return Action(arguments, python, f"Campaign {file}", (str(ledger),))


def resume(ledger: Path) -> Action:
    """A campaign that stopped, on to the results that it would have had."""
    python = _campaign(ledger, "resume_campaign", "ledger")
    arguments = ("campaign", "resume", path_argument(ledger))
    return Action(arguments, python, f"Campaign {ledger}, going on", (str(ledger),))


def _campaign(ledger: Path, function: str, arguments: str) -> str:
    return _joined(
        "from pathlib import Path",
        "",
        f"from microrad.campaign.run import Means, {function}",
        "from microrad.campaign.statistics.summary import summarise_campaign",
        "from microrad.report.campaign.text import campaign_text",
        "",
        f"ledger = {_path(ledger)}",
        f"{function}({arguments}, Means())",
        f"print(campaign_text(summarise_campaign(ledger), {_WIDTH}))",
    )


def campaign_report(ledger: Path, page: Path) -> Action:
    """The page with the pictures of a campaign's ledger.

    Args:
        ledger: the ledger, seen from the working folder.
        page: the page to write; one that is there is replaced.
    """
    python = _joined(
        "from pathlib import Path",
        "",
        "from microrad.campaign.statistics.summary import summarise_campaign",
        "from microrad.report.campaign.page import campaign_page",
        "",
        f"text = campaign_page(summarise_campaign({_path(ledger)}))",
        f'{_path(page)}.write_text(text, encoding="utf-8")',
    )
    arguments = ("campaign", "report", path_argument(ledger), path_argument(page), "--overwrite")
    return Action(arguments, python, f"Report of {ledger}", (str(page),))


# -------------------------------------------------------------------------------------------------------- the mirror
def identify(  # noqa: PLR0913  all but the first four are named options
    files: Sequence[Path],
    drive: str,
    output: str,
    mirror_file: Path,
    *,
    name: str,
    units: tuple[str, str] = ("V", "mrad"),
    rate_hz: float | None = None,
    accept: tuple[str, ...] = (),
    validate: Sequence[Path] = (),
    lever_arm_m: float | None = None,
    static: bool = False,
    admissible: bool = False,
) -> Action:
    """A mirror from recordings, into a mirror file and its report.

    Args:
        files: recordings that are fitted.
        drive: name or number of its column, counted from 0.
        output: name or number of its column.
        mirror_file: the mirror file to write.
        name: that of the mirror.
        units: those of drive and output.
        rate_hz: None where the files say it.
        accept: findings that do not stop it.
        validate: recordings that are checked and not fitted.
        lever_arm_m: that of a displacement, None for an angle.
        static: whether the hysteresis alone is fitted.
        admissible: whether no model is taken that moves the wrong way.
    """
    options: tuple[tuple[str, object], ...] = (
        ("--input", drive),
        ("--output", output),
        ("--rate", rate_hz),
        *(("--accept", finding) for finding in accept),
        *(("--validate", file) for file in validate),
        ("--input-unit", units[0]),
        ("--output-unit", units[1]),
        ("--lever-arm", None if lever_arm_m is None else f"{lever_arm_m!r} m"),
        ("--name", name),
        ("--mirror-file", mirror_file),
    )
    switches = {"--static": static, "--admissible": admissible}
    arguments = (
        "identify",
        *map(path_argument, files),
        *(part for key, value in options for part in _option(key, value)),
        *(switch for switch, on in switches.items() if on),
    )
    page = mirror_file.with_suffix(".html")
    settings = (
        f"models=identify.{'STATIC[:2]' if static else 'MODELS'}",
        f"validation=[read(file) for file in {list(map(str, validate))}]",
        f"lever_arm_m={lever_arm_m!r}, admissible={admissible!r}, input_unit={units[0]!r}, output_unit={units[1]!r}",
    )
    python = _joined(
        "from pathlib import Path",
        "",
        "from microrad import read_recording, report",
        "from microrad.lab import identify, recording",
        "",
        f"target, page = {_path(mirror_file)}, {_path(page)}",
        "if target.exists():",
        "    raise FileExistsError(target)",
        "",
        "",
        "def read(file):",
        f"    found = read_recording(file, {drive!r}, {output!r}, {rate_hz!r}, accept={accept!r})",
        f"    return recording.read_in(found, {units[0]!r}, {units[1]!r})",
        "",
        "",
        f"recordings = [read(file) for file in {list(map(str, files))}]",
        f"found = identify.identify(recordings, {', '.join(settings)})",
        "if found.unsupported:",
        "    raise SystemExit(found.unsupported)",
        f"text = identify.mirror_file_text(found, {name!r}, model=found.chosen)",
        "report.write_identification(",
        "    found,",
        "    page,",
        "    mirror_file=target,",
        "    mirror_text=text,",
        f"    title={name!r},",
        "    written=found.chosen,",
        "    recordings=recordings,",
        ")",
        'target.write_text(text, encoding="utf-8")',
        "print(report.identification_text(found, found.chosen, mirror_file=target, report_file=page))",
    )
    return Action(arguments, python, f"identify {name}", (str(mirror_file), str(page)))


# -------------------------------------------------------------------------------------------------------------- pieces
def _option(name: str, value: object) -> tuple[str, ...]:
    """An option with its value, in one word where the value begins like an option; nothing without a value."""
    if value is None:
        return ()
    said = path_argument(value) if isinstance(value, Path) else repr(value) if isinstance(value, float) else str(value)
    return (f"{name}={said}",) if said.startswith("-") else (name, said)


def _path(path: Path) -> str:
    """A path in Python."""
    return f"Path({str(path)!r})"


def _joined(*lines: str) -> str:
    return "\n".join(lines) + "\n"
