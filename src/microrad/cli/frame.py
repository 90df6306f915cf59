"""The frame of every command: the application, failures in words, exit codes, output, files written whole.

Data goes to stdout, progress and refusals to stderr. Exit codes: 0 done, 1 a study whose requirements are not all met
or an installation with a problem, 2 bad usage or a bad file, 70 a fault of microrad, 130 interrupted, 141 nobody read
the output.
"""

import _thread
import contextlib
import functools
import gc
import io
import json
import math
import os
import shutil
import signal
import sys
import threading
import time
import traceback
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from enum import StrEnum
from io import TextIOWrapper
from pathlib import Path
from typing import Annotated, Any, NoReturn, ParamSpec

import typer

from microrad.core import compiling
from microrad.core.folder import read_bytes
from microrad.core.units import BLANKS, printable

MET, UNMET, REFUSED, BUG, INTERRUPTED, UNREAD = 0, 1, 2, 70, 130, 141

PROGRESS_FILE = "MICRORAD_PROGRESS"
"""Environment variable that names a file for progress, as JSON lines, in place of a bar or lines on stderr."""

_BAR_S = 0.05  # between two looks of the bar
_PROGRESS_S = 0.2  # between two lines of a progress file, unless another phase begins
_PROGRESS_BYTES = 1_000_000  # of a progress file, which begins anew beyond

_Arguments = ParamSpec("_Arguments")
OnProgress = Callable[[int, int, str], None]


class Judged(StrEnum):
    """What the exit code of a study says."""

    REQUIREMENTS = "requirements"
    CLOSES = "closes"

    def code(self, *, met: bool, closes: bool) -> int:
        """0 where that holds, else 1.

        Args:
            met: Whether all requirements are met.
            closes: Whether the links close.
        """
        return MET if (met if self is Judged.REQUIREMENTS else closes) else UNMET


class Refusal(ValueError):  # noqa: N818  a refusal is no error of the program
    """Something that cannot be done as asked; the message says why and what to do."""


@dataclass(frozen=True, slots=True)
class Outcome:
    """What a command found: the text for stdout and the exit code.

    It is printed when the work is done. Work that the text does not depend on is done ``afterwards``: the text that it
    returns is printed behind.
    """

    text: str
    code: int = 0
    afterwards: Callable[[], str] | None = None


# ------------------------------------------------------------------------------------------------------------ the app
def examples(*lines: str) -> str:
    """The end of a command's help: lines to copy."""
    return "\n".join(["\b", "Examples:", *(f"  {line}" for line in lines)])


def group(name: str, text: str, epilog: str, **settings: Any) -> typer.Typer:
    """A group of commands.

    Args:
        name: Its name.
        text: Its help.
        epilog: The end of its help.
        settings: What else typer takes.
    """
    return typer.Typer(
        name=name,
        help=text,
        epilog=epilog,
        no_args_is_help=True,
        pretty_exceptions_enable=False,
        rich_markup_mode=None,  # plain help: quick, and lines that can be searched and copied
        **settings,
    )


app = group(
    "microrad",
    "Design, identify and simulate the pointing chain of a small-satellite laser terminal.",
    examples(
        "microrad init                    write a mission, ready to run",
        "microrad run leo-geo.toml        the whole study: a verdict and a report",
        "microrad identify --help         a mirror model from your own recordings",
    )
    + "\n\nExit code: 0 done, 1 a requirement is not met, 2 bad usage or a bad file.",
    context_settings={"help_option_names": ["-h", "--help"]},
)


def main() -> None:
    """Run the command line and exit; a request to terminate is taken as Ctrl-C is."""
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # small matrices: its threads would get in the way of ours
    gc.set_threshold(50_000, 20, 50)  # most objects stay: by default a tenth of a run goes into looking through them
    for number in (signal.SIGTERM, getattr(signal, "SIGHUP", signal.SIGTERM)):
        if signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, signal.default_int_handler)
    sys.unraisablehook = interrupt_again
    compiling.on_first(lambda: say("compiling the loops for this processor: once, for about half a minute"))
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, TextIOWrapper):
            stream.reconfigure(errors="replace")  # a terminal without µ is no reason to fail
    try:
        app(prog_name="microrad")
    except SystemExit as ended:
        if ended.code == INTERRUPTED:
            _leave(INTERRUPTED)
        raise


def _leave(code: int) -> NoReturn:
    """End the process where it stands: an interrupt may have left half a module in the compiler.

    The interpreter would take that apart at its end, and crash now and then (seen: llvmlite, in one of 100 interrupts
    while loops are loaded). Files and folders are in order by then: what was open has been left by its own way out.
    """
    for stream in (sys.stdout, sys.stderr):
        with contextlib.suppress(OSError, ValueError):
            stream.flush()
    os._exit(code)


def interrupt_again(unraisable: "sys.UnraisableHookArgs") -> None:
    """Take up an interrupt that fell into a call back from compiled code (LLVM has one), which cannot pass it on.

    It is raised again a moment later, when that code has returned; anything else is reported as Python does.
    """
    if issubclass(unraisable.exc_type, KeyboardInterrupt):
        threading.Timer(0.05, _thread.interrupt_main).start()
    else:
        sys.__unraisablehook__(unraisable)


def command(body: Callable[_Arguments, Outcome]) -> Callable[_Arguments, NoReturn]:
    """A command for typer: do the work, print what came out, and turn whatever went wrong into words and a code."""

    @functools.wraps(body)
    def wrapped(*args: _Arguments.args, **kwargs: _Arguments.kwargs) -> NoReturn:
        try:
            outcome = body(*args, **kwargs)
            code = _printed(outcome.text, outcome.code)
            if outcome.afterwards and code != INTERRUPTED:
                code = _printed(outcome.afterwards(), code)
        except (Exception, KeyboardInterrupt) as error:
            raise typer.Exit(_failed(error)) from None
        raise typer.Exit(code)

    return wrapped


def _printed(text: str, code: int) -> int:
    """Print a text and return the exit code that there was, or the one for an output that nobody takes.

    A page is printed as it is; in all else is spelled out what a name from a file would do to a terminal.
    """
    try:
        print(text if text.startswith("<!") else printable(text, BLANKS), flush=True)
    except BrokenPipeError:
        _close_stdout()
        return UNREAD
    except OSError as error:
        _close_stdout()
        say(f"the output cannot be written: {error.strerror}")
        return REFUSED
    except KeyboardInterrupt:
        _close_stdout()
        say("interrupted while printing")
        return INTERRUPTED
    return code


def _close_stdout() -> None:
    """Let what is still buffered go nowhere, so that the interpreter's own flush at the end stays silent."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


# ------------------------------------------------------------------------------------------------------------ failures
def say(message: str) -> None:
    """One line to the user, on stderr."""
    print(f"microrad: {printable(message, BLANKS)}", file=sys.stderr)


def _failed(error: BaseException) -> int:
    """Say what went wrong, on stderr; returns the exit code."""
    if interrupted(error):
        said = str(error) if isinstance(error, KeyboardInterrupt) else ""
        say(said or "interrupted, nothing was written")
        return INTERRUPTED
    if isinstance(error, OSError):
        where, there = (f"{error.filename}: ", " there") if error.filename else ("", "")
        say(f"{where}{error.strerror or error}; nothing was written{there}. Check free space and permissions.")
        return REFUSED
    if _meant_for_users(error):
        page = getattr(error, "page", "") or getattr(error.__cause__, "page", "")
        say((str(error) or "not enough memory") + (f" (see docs/{page}.md)" if page else ""))
        return REFUSED
    traceback.print_exception(error)
    say("a fault of microrad or of its installation: run microrad doctor; if all is well, report the lines above.")
    return BUG


@contextlib.contextmanager
def refusal_of(file: Path) -> Iterator[None]:
    """Name the file in front of what cannot be done with it: a rate that a receiver does not take, an unstable loop."""
    try:
        yield
    except ValueError as error:
        raise Refusal(f"{file}: {error}") from error


def interrupted(error: BaseException | None) -> bool:
    """Whether an interrupt is behind an error: one that falls into an import comes out as another error."""
    while error is not None and not isinstance(error, KeyboardInterrupt):
        error = error.__cause__ or error.__context__
    return error is not None


def _meant_for_users(error: BaseException) -> bool:
    """Whether the message is an answer: each ValueError that microrad defines is written for its user."""
    ours = isinstance(error, ValueError) and type(error).__module__.startswith("microrad.")
    return ours or isinstance(error, MemoryError)


# ------------------------------------------------------------------------------------------------------------- output
def json_text(data: Any) -> str:
    """One JSON document; what is no finite number becomes null, which JSON can say."""
    return json.dumps(_finite(data), indent=2, allow_nan=False)


def _finite(data: Any) -> Any:
    if isinstance(data, dict):
        return {key: _finite(value) for key, value in data.items()}
    if isinstance(data, list | tuple):
        return [_finite(value) for value in data]
    return None if isinstance(data, float) and not math.isfinite(data) else data


def _progress_lines(every_s: float) -> OnProgress:
    """Progress for a log: a line now and then, none in the first interval."""
    last_s = time.monotonic()

    def say_now_and_then(done: int, total: int, what: str) -> None:
        nonlocal last_s
        if time.monotonic() - last_s >= every_s:
            last_s = time.monotonic()
            say(f"{done} of {total}: {what}")

    return say_now_and_then


def _progress_records(file: io.FileIO) -> OnProgress:
    """Progress for a program that looks on: a JSON object a line, with the time (s, since 1970) in "at"."""
    last_s, last = -math.inf, (0, "")

    def write_down(done: int, total: int, what: str) -> None:
        nonlocal last_s, last
        now_s = time.monotonic()
        if now_s - last_s < _PROGRESS_S and (total, what) == last and done < total:
            return
        last_s, last = now_s, (total, what)
        line = json.dumps({"at": round(time.time(), 3), "done": done, "total": total, "what": what})
        with contextlib.suppress(OSError):  # a full disk is the run's affair
            if file.tell() > _PROGRESS_BYTES:
                file.truncate(0)
            file.write(f"{line}\n".encode())

    return write_down


@contextlib.contextmanager
def progress_bar(line_s: float = math.inf) -> Iterator[OnProgress]:
    """A bar on stderr while something is computed, where stderr is a terminal; a line every ``line_s`` elsewhere.

    It moves with the progress alone: for more it would need a thread, beside which no process can be forked.
    Where the environment variable `PROGRESS_FILE` names a file, progress goes there and nowhere else.
    """
    if name := os.environ.get(PROGRESS_FILE):
        with Path(name).open("ab", buffering=0) as records:
            yield _progress_records(records)
        return
    if not (sys.stderr and sys.stderr.isatty()):
        yield _progress_lines(line_s)
        return
    from rich.console import Console
    from rich.progress import Progress

    last_s = -math.inf
    with Progress(console=Console(stderr=True), transient=True, auto_refresh=False) as bar:
        task = bar.add_task("reading", total=None)

        def move(done: int, total: int, what: str) -> None:
            nonlocal last_s
            bar.update(task, completed=done, total=total, description=what)
            if done == total or time.monotonic() - last_s >= _BAR_S:
                last_s = time.monotonic()
                bar.refresh()

        yield move


def width() -> int:
    """Columns for tables: those of the terminal, of the variable COLUMNS, or 80, also where the output is piped."""
    return max(shutil.get_terminal_size((80, 24)).columns, 80)


def check_target(path: Path, advice: str, *, overwrite: bool = False, begins: bytes = b"") -> None:
    """Refuse a file that must not be written.

    Args:
        path: The file.
        advice: What to do where it exists, the end of the message.
        overwrite: Whether a file of its kind that microrad wrote may be replaced, or one that is empty.
        begins: How files of its kind begin; empty for those that are never replaced.

    Raises:
        Refusal: There is no folder for it, or something that must stay.
        OSError: The file that is there cannot be read.
    """
    if not path.parent.is_dir():
        raise Refusal(f"{path}: there is no folder {path.parent}; create it first.")
    if not os.path.lexists(path):
        return
    if not (overwrite and begins):
        replace = ", or replace it with --overwrite" if begins else ""
        raise Refusal(f"{path} exists and is left as it is; {advice}{replace}.")
    if path.is_dir() or read_bytes(path, len(begins)) not in (b"", begins):
        raise Refusal(f"{path} was not written by microrad and is left as it is; {advice}.")


def option(flag: str, metavar: str, text: str, **settings: Any) -> Any:
    """An option of a command.

    Args:
        flag: Its name, as ``--output``.
        metavar: The name of its value.
        text: Its help.
        settings: What else typer takes.
    """
    return typer.Option(flag, metavar=metavar, help=text, **settings)


# ----------------------------------------------------------------------------------------------------------- commands
Json = Annotated[bool, typer.Option("--json", help="Print one JSON document and nothing else.")]
Verbose = Annotated[bool, typer.Option("--verbose", help="All of it: sources, other tables, every warning.")]
ExitOn = Annotated[
    Judged,
    option("--exit-on", "WHAT", "What exit code 0 stands for: requirements, all are met; closes, the links do."),
]
_ACCEPT = "Take a controller, too, that leaves more than 1.5 times its linear residual when it is simulated."
Accept = Annotated[bool, typer.Option("--accept", help=_ACCEPT)]
Overwrite = Annotated[bool, typer.Option("--overwrite", help="Replace what an earlier run wrote.")]


def _version(wanted: bool) -> None:
    if wanted:
        from microrad import __version__

        print(f"microrad {__version__}")
        raise typer.Exit


_Version = Annotated[bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version.")]


@app.callback()
def _options(version: _Version = False) -> None:
    pass
