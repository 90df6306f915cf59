"""The reference of the command line, from the commands themselves."""

import re
from collections.abc import Iterator
from typing import Any

import typer

from microrad.cli import app
from site_pages.tables import code, plain, table

_HEAD = """# Commands

Data stand on stdout, progress and refusals on stderr. Exit code 0: done. 1: a requirement is not met. 2: bad usage or a
bad file.
"""


def commands() -> Iterator[tuple[str, Any]]:
    """Each command by its whole name, groups left out."""
    yield from _below("microrad", typer.main.get_command(app))


def _below(name: str, command: Any) -> Iterator[tuple[str, Any]]:
    inside = getattr(command, "commands", None)
    if inside is None:
        yield name, command
        return
    for each, found in inside.items():
        yield from _below(f"{name} {each}", found)


def pages() -> dict[str, str]:
    """The page of all commands."""
    found = dict(commands())
    rows = [
        (f"[{name}](#{name.replace(' ', '-')})", plain(_said(command).partition("\n")[0]))
        for name, command in found.items()
    ]
    parts = [_HEAD, table(("command", "what it does"), rows), *(_part(*each) for each in found.items())]
    return {"commands.md": "\n\n".join(parts) + "\n"}


def _said(command: Any) -> str:
    return (command.help or "").partition("\f")[0].replace("\b", "").strip()


def _part(name: str, command: Any) -> str:
    context = typer.Context(command, info_name=name)
    usage = " ".join((name, *command.collect_usage_pieces(context)))
    rows = [_row(each, context) for each in command.params if not getattr(each, "hidden", False)]
    epilog = (command.epilog or "").replace("\b", "").strip().removeprefix("Examples:").rstrip()
    shown = "\n".join(line.strip() for line in epilog.splitlines() if line.strip())
    parts = [
        f"## {name}",
        plain(_said(command)),
        f"```text\n{usage}\n```",
        table(("argument or option", "default", "meaning"), rows) if rows else "",
        f"```console\n{shown}\n```" if shown else "",
    ]
    return "\n\n".join(part for part in parts if part)


def _row(each: Any, context: Any) -> tuple[str, str, str]:
    words, said = each.get_help_record(context)
    meaning, default = re.fullmatch(r"(.*?)\s*(?:\[(default: .*|required)\])?", " ".join(said.split())).groups("")
    return code(words), plain(default.removeprefix("default: ")), plain(meaning)
