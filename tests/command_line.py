"""What a command that is run in this process leaves: its output and exit code, and the files of a folder."""

from typing import NamedTuple


class Result(NamedTuple):
    code: int
    out: str
    err: str


def listing(folder):
    """Every file below a folder with its content."""
    return {str(p.relative_to(folder)): p.read_bytes() if p.is_file() else b"" for p in sorted(folder.rglob("*"))}
