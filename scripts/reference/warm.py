"""Commands of microrad in forks of a process that has run one: loading the libraries takes a second of each."""

import gc
import importlib
import os
import runpy
import sys
import tempfile
import traceback
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import IO, NoReturn

from reference import inside

LIBRARIES = (
    *("numba", "scipy.linalg", "scipy.optimize", "scipy.signal", "xarray", "h5netcdf", "jinja2"),
    *("skyfield.api", "microrad.campaign.run", "microrad.report.study.page", "microrad.export.flight.write"),
    *("microrad.lab.bench", "microrad.lab.identify", "microrad.export.linear_import"),
    "microrad.report.identification.page",
)
"""What most commands load beside what the first one does."""

is_loaded = False
"""Whether this process has them, and those that it forks."""

inside_of: list[Path] = []
"""Folder where each command of a case leaves what the functions inside of it return."""


def load(words: Sequence[str], folder: Path) -> None:
    """Run a command once in a process without threads, which the forks then have loaded."""
    global is_loaded  # noqa: PLW0603
    os.environ["MICRORAD_KEEP"] = "no"
    inside.tell()
    for name in LIBRARIES:
        importlib.import_module(name)
    os.chdir(folder)
    ends = os.dup(1)
    with tempfile.TemporaryFile() as out:
        os.dup2(out.fileno(), 1)
        code = _ended(words)
        sys.stdout.flush()
        os.dup2(ends, 1)
    os.close(ends)
    gc.freeze()  # a collection would copy all of it into the fork
    is_loaded = code == 0


def run(
    words: Sequence[str], folder: Path, environment: Mapping[str, str], program: Path | None = None
) -> tuple[int, str, str]:
    """Exit code, output and errors of a command in a fork of this process.

    Args:
        words: Of the command.
        folder: Where it runs.
        environment: Its variables.
        program: A file of Python in place of microrad.
    """
    sys.stdout.flush()  # what waits to be written would be written by the fork as well
    sys.stderr.flush()
    with tempfile.TemporaryFile() as out, tempfile.TemporaryFile() as err:
        left = inside_of[-1] / f"{len(list(inside_of[-1].iterdir())) + 1}.json" if is_loaded and inside_of else None
        if (child := os.fork()) == 0:
            _become(partial(_watched, left, words, program), folder, environment, out, err)
        code = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
        return code, _text(out), _text(err)


def _become(
    command: Callable[[], int], folder: Path, environment: Mapping[str, str], out: IO[bytes], err: IO[bytes]
) -> NoReturn:
    code = 70
    try:
        os.dup2(out.fileno(), 1)
        os.dup2(err.fileno(), 2)
        os.chdir(folder)
        os.environ.clear()
        os.environ.update(environment)
        code = command()
    except BaseException:
        traceback.print_exc()
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)


def _watched(left: Path | None, words: Sequence[str], program: Path | None) -> int:
    """A command of which it is written down what its functions return, where there is a file for that."""
    if left is None:
        return _ended(words, program)
    watch = inside.Watch()
    watch.begin()
    try:
        return _ended(words, program)
    finally:
        watch.end(left)


def _ended(words: Sequence[str], program: Path | None = None) -> int:
    """`python -m microrad` with these words in this process, or another program."""
    sys.argv = [str(program or "microrad"), *words]
    try:
        if program:
            runpy.run_path(str(program), run_name="__main__")
        else:
            runpy.run_module("microrad", run_name="__main__", alter_sys=True)
    except SystemExit as end:
        return end.code if isinstance(end.code, int) else int(end.code is not None)
    return 0


def _text(file: IO[bytes]) -> str:
    file.seek(0)
    return file.read().decode("utf-8")
