"""Exported code on this machine: compiled with the compiler that is here, and its bench run over the vectors.

Nothing here passes through a shell, and every program is given a time to end in.
"""

import math
import os
import shlex
import shutil
import signal
import subprocess
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, fields
from pathlib import Path

from microrad.export.records import ExportError

COMPILERS = ("cc", "gcc", "clang")
"""Compilers that are looked for, in this order, where the environment variable CC names none."""

FLAGS = ("-std=c99", "-O2", "-Wall", "-Wextra", "-Werror", "-pedantic")
"""What exported code is compiled with."""

TIME_LIMIT_S = 300.0
"""A compiler or bench that takes longer is ended: each takes seconds."""

FIRST_LINES = 12
"""So many lines of what a failed program wrote go into the message."""


@dataclass(frozen=True, slots=True)
class BenchResult:
    """What the bench of exported code printed.

    ``largest_difference_v`` is the largest difference of a command from the recorded one, ``bound_v`` what is allowed,
    ``peak_command_v`` the largest recorded command. ``saturated`` and the counters behind it are those of the code's
    state at the end. Times are of one step: each sample's least time over the passes, then the largest (worst) and the
    median of the samples, less ``clock_ns``, what reading the clock takes. ``cycles_per_ns`` is the rate of the
    processor's counter of cycles; 0 where a program cannot read one.
    """

    samples: int
    largest_difference_v: float
    peak_command_v: float
    bound_v: float
    saturated: int
    rate_clamped: int
    rejected: int
    faults: int
    worst_step_ns: float
    median_step_ns: float
    clock_ns: float
    cycles_per_ns: float


def compiler() -> str | None:
    """The C compiler: what the environment variable CC says (which may hold arguments too), else cc, gcc or clang.

    None where there is none. `compiler_words` splits it.

    Raises:
        ExportError: When CC names a program that is not there.
    """
    asked = os.environ.get("CC", "").strip()
    if not asked:
        return next((each for each in COMPILERS if shutil.which(each)), None)
    if shutil.which(_words(asked)[0]) is None:
        raise ExportError(
            f"the environment variable CC is {asked!r}, and there is no such program on the path: set CC to a C "
            "compiler that is there, or unset it"
        )
    return asked


def compiler_words() -> tuple[str, ...]:
    """The compiler and its arguments as the first words of a command.

    Raises:
        ExportError: Where there is no compiler.
    """
    found = compiler()
    if found is None:
        raise ExportError(
            f"no C compiler was found (looked for {', '.join(COMPILERS)}): install one or name it in the environment "
            "variable CC; the exported files themselves need none"
        )
    return _words(found)


def _words(text: str) -> tuple[str, ...]:
    """A command's words; a path with spaces in it that is a program is one word."""
    if shutil.which(text):
        return (text,)
    try:
        return tuple(shlex.split(text))
    except ValueError as error:
        raise ExportError(f"the environment variable CC is {text!r}: {str(error).lower()}") from error


def compile_and_run(folder: Path, name: str, passes: int = 20) -> BenchResult:
    """Compile exported code and run its test bench over the recorded run beside it.

    With a Makefile (and make on this machine) it is compiled by ``make``, else by the compiler directly.

    Args:
        folder: Folder with the code, its bench and ``vectors.csv``; the compiled bench is put there, too.
        name: What the code is called: the bench is {name}_bench.c.
        passes: Passes over the run in which the steps are timed, at least 1.

    Raises:
        ExportError: Where there is no compiler or no such code, where it does not compile, and where the bench fails,
            takes longer than `TIME_LIMIT_S` or finds a difference beyond its bound.
    """
    if passes < 1:
        raise ExportError(f"{passes} passes of the bench: it takes at least 1 to time a step")
    missing = [each for each in (f"{name}.c", f"{name}_bench.c", "vectors.csv") if not (folder / each).is_file()]
    if missing:
        raise ExportError(f"{folder} has no {', no '.join(missing)}: export the code there first (microrad export c)")
    code, text = run((str(_compile(folder, name)), "vectors.csv", str(passes)), folder)
    found = _numbers(text)
    if code == 1 and found.get("largest_difference_v", 0.0) > found.get("bound_v", math.inf):
        raise ExportError(
            f"the compiled code of {name} in {folder} commands up to {found['largest_difference_v']:.3g} V off the "
            f"recorded run, and its bound is {found['bound_v']:.3g} V: compile it without options that change "
            "arithmetic (-ffast-math), and check that vectors.csv belongs to it"
        )
    if code != 0:
        raise _failure(f"the bench of {name} in {folder} {_ending(code)}", text)
    kinds = {each.name: each.type for each in fields(BenchResult)}
    missing = [key for key in kinds if key not in found]
    if missing:
        raise _failure(f"the bench of {name} in {folder} printed no {', no '.join(missing)}", text)
    return BenchResult(**{key: int(found[key]) if kind is int else found[key] for key, kind in kinds.items()})  # type: ignore[arg-type]


def _compile(folder: Path, name: str) -> Path:
    """The compiled bench."""
    words, target = compiler_words(), folder / f"{name}_bench"
    if (folder / "Makefile").is_file() and shutil.which("make"):
        command: tuple[str, ...] = ("make", "--always-make", f"CC={shlex.join(words)}", target.name)
    else:
        sources = sorted(each.name for each in folder.glob("*.c") if not each.name.endswith("_bench.c"))
        command = (*words, *FLAGS, "-o", target.name, *sources, f"{name}_bench.c", "-lm")
    code, text = run(command, folder)
    if code != 0:
        raise _failure(f"{shlex.join(command)} in {folder} {_ending(code)}", text)
    return target.resolve()


def run(command: Sequence[str], folder: Path) -> tuple[int, str]:
    """Exit status and what the program wrote; whatever ends the wait ends the program and all that it started.

    Args:
        command: The program and its arguments.
        folder: Where it runs.

    Raises:
        ExportError: It cannot be started, or takes longer than `TIME_LIMIT_S`.
    """
    # A make that this runs under would pass its own options on, and its locale would translate messages.
    environment = {key: value for key, value in os.environ.items() if key not in ("MAKEFLAGS", "MFLAGS", "MAKELEVEL")}
    environment["LC_ALL"] = "C"
    try:
        process = subprocess.Popen(
            command,
            cwd=folder,
            env=environment,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            errors="replace",
            start_new_session=True,
        )
    except OSError as error:
        raise ExportError(f"{command[0]} cannot be run in {folder}: {error.strerror}") from error
    with process:
        try:
            text, _ = process.communicate(timeout=TIME_LIMIT_S)
        except BaseException as error:
            if hasattr(os, "killpg"):  # with what it started: make's compiler
                with suppress(ProcessLookupError):
                    os.killpg(process.pid, signal.SIGKILL)
            else:
                process.kill()
            if isinstance(error, subprocess.TimeoutExpired):
                what = f"{shlex.join(command)} in {folder} did not end within {TIME_LIMIT_S:g} s and was stopped"
                raise ExportError(what) from error
            raise
    return process.returncode, text


def _ending(code: int) -> str:
    return f"was ended by signal {-code}" if code < 0 else f"failed with exit status {code}"


def _failure(what: str, text: str) -> ExportError:
    lines = [line for line in text.splitlines() if line.strip()] or ["(it wrote nothing)"]
    more = [f"... and {len(lines) - FIRST_LINES} lines more"] if len(lines) > FIRST_LINES else []
    return ExportError("\n  ".join([f"{what}:", *lines[:FIRST_LINES], *more]))


def _numbers(text: str) -> dict[str, float]:
    """The lines ``key value`` among those that the bench printed."""
    found = {}
    for words in map(str.split, text.splitlines()):
        if len(words) == 2:
            try:
                found[words[0]] = float(words[1])
            except ValueError:
                continue
    return found
