"""Cases of a format: each is made from its number, given to what reads it, and judged.

Case ``number`` of a format under a seed is the same input everywhere. What is no refusal, breaks a property, takes too
long or too much memory is a find. `here` runs cases in this process; `apart` in a child, which may hang or crash.
"""

import faulthandler
import json
import mmap
import os
import resource
import signal
import struct
import sys
import tempfile
import time
import traceback
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from random import Random
from typing import Any, Protocol

from fuzzing.limits import TooLongError, timer
from fuzzing.properties import DocumentedError

_SILENT_S = 300.0  # until a child that finishes no case is taken to hang where no signal reaches it
_LONGEST_REFUSAL = 20_000
_KEPT_OF_A_KIND = 3
_AT = struct.Struct("<qqqdqd")  # number, taken, refused, longest (s), which case that was, most memory (bytes)


class Format(Protocol):
    """What is given bad inputs: how one is made, what takes it, and the processor time and memory that it may take."""

    name: str
    most_s: float
    most_bytes: int

    def made(self, draw: Random) -> Any:
        """A bad input; bytes where it is a file's content."""

    def take(self, made: Any, folder: Path) -> None:
        """Read it and check what comes of it; raises a refusal, or AssertionError for a property that is broken."""


@dataclass(frozen=True, slots=True)
class Find:
    """A case that is no refusal and no good answer: what happened in a line, and where."""

    format: str
    number: int
    what: str
    trace: str


@dataclass(slots=True)
class Tally:
    """What became of the cases of a format; ``memory_bytes`` is how far the process grew beyond its begin."""

    format: str
    taken: int = 0
    refused: int = 0
    longest_s: float = 0.0
    longest: int = -1
    memory_bytes: float = 0.0
    finds: list[Find] = field(default_factory=list)

    @property
    def cases(self) -> int:
        """How many there were."""
        return self.taken + self.refused + len(self.finds)


def case(kind: Format, seed: int, number: int) -> Any:
    """The input of a case.

    Args:
        kind: Its format.
        seed: The seed of the run.
        number: Its number.
    """
    return kind.made(Random(f"{seed} {kind.name} {number}"))


def is_refusal(error: BaseException) -> bool:
    """Whether an error is an answer to the user, as the command line has it: a ValueError that microrad defines.

    Of a public function a plain ValueError is one, too, where it says so (`properties.documented`).
    """
    own = type(error).__module__.startswith("microrad.") or isinstance(error, DocumentedError)
    return isinstance(error, ValueError) and own


def judged(kind: Format, made: Any, folder: Path, most_s: float) -> tuple[bool, str, str]:
    """Whether an input was taken; what is wrong with that, "" for nothing; and the traceback.

    Args:
        kind: Its format.
        made: The input.
        folder: For files.
        most_s: Processor time that it may take.
    """
    try:
        with timer(most_s), warnings.catch_warnings():
            warnings.simplefilter("error")
            kind.take(made, folder)
    except (Exception, TooLongError) as error:
        trace = "".join(traceback.format_exception(error, limit=-12))
        if not is_refusal(error):
            return False, f"{type(error).__name__}: {str(error)[:200]}{_place(error)}", trace
        return False, _fault_of_words(error), trace
    return True, "", ""


def _fault_of_words(error: BaseException) -> str:
    """What is wrong with a refusal: it is one line, or one for each fault of a file, and can be read."""
    words = str(error)
    if not words.strip():
        return f"{type(error).__name__} without a word"
    if len(words) > _LONGEST_REFUSAL:
        return f"{type(error).__name__} of {len(words)} characters"
    if "\n" in words and not hasattr(error, "faults"):
        return f"{type(error).__name__} of several lines: {words[:200]!r}"
    return ""


def _place(error: BaseException) -> str:
    """The last line of microrad that an error passed."""
    frames = [f for f in traceback.extract_tb(error.__traceback__) if "/microrad/" in f.filename]
    return f" at {frames[-1].filename.partition('/microrad/')[2]}, {frames[-1].name}" if frames else ""


def here(kind: Format, seed: int, numbers: Sequence[int], most_s: float) -> Tally:
    """Run cases in this process.

    Args:
        kind: Their format.
        seed: The seed of the run.
        numbers: Which ones.
        most_s: Processor time that a case may take.
    """
    tally = Tally(kind.name)
    with _folder() as folder:
        for number in numbers:
            _count(tally, kind, seed, number, folder, most_s)
    return tally


def _count(tally: Tally, kind: Format, seed: int, number: int, folder: Path, most_s: float) -> None:
    made = case(kind, seed, number)
    begin_s = time.process_time()
    is_taken, what, trace = judged(kind, made, folder, most_s)
    if what.startswith(TooLongError.__name__):  # what is loaded or compiled once is nobody's
        judged(kind, made, folder, 10.0 * most_s)
        begin_s = time.process_time()
        is_taken, what, trace = judged(kind, made, folder, most_s)
    took_s = time.process_time() - begin_s
    if took_s > tally.longest_s:
        tally.longest_s, tally.longest = took_s, number
    if what:
        tally.finds.append(Find(kind.name, number, what, trace))
    elif is_taken:
        tally.taken += 1
    else:
        tally.refused += 1


@contextmanager
def _folder() -> Iterator[Path]:
    """A new folder, in memory where there is such a place."""
    memory = Path("/dev/shm")
    with tempfile.TemporaryDirectory(prefix="microrad-fuzz-", dir=memory if memory.is_dir() else None) as name:
        yield Path(name)


# ----------------------------------------------------------------------------------------------------------- in a child
def apart(kind: Format, seed: int, numbers: range, keep: Path) -> Tally:
    """Run cases in children: one that hangs where no signal reaches it, crashes or grows too far ends with its case.

    Args:
        kind: Their format.
        seed: The seed of the run.
        numbers: Which ones.
        keep: Folder for the finds.
    """
    whole, place = Tally(kind.name), numbers.start
    while place < numbers.stop:
        shared = mmap.mmap(-1, _AT.size)
        shared[:] = _AT.pack(place, 0, 0, 0.0, -1, 0.0)
        notes = tempfile.TemporaryFile("w+")  # noqa: SIM115  closed below, and the child writes to it
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", DeprecationWarning)  # of threads, which a child leaves alone
            child = os.fork()
        if not child:
            _run(kind, seed, range(place, numbers.stop), shared, notes, keep)
        status, hangs = _waited_for(child, shared)
        number, taken, refused, longest_s, longest, memory = _AT.unpack(shared[:])
        notes.seek(0)
        finds = [Find(kind.name, *json.loads(line)) for line in notes]
        notes.close()
        if status and not any(each.number == number for each in finds):
            why = f"hangs for {_SILENT_S:g} s" if hangs else f"ends the process: status {status}"
            finds.append(Find(kind.name, number, why, ""))
            _keep(keep, kind, seed, finds[-1])
        whole.taken += taken
        whole.refused += refused
        whole.finds += finds
        whole.memory_bytes = max(whole.memory_bytes, memory)
        if longest_s > whole.longest_s:
            whole.longest_s, whole.longest = longest_s, longest
        place = number + 1 if status else numbers.stop
    return whole


def _waited_for(child: int, shared: mmap.mmap) -> tuple[int, bool]:
    """Wait for the end of a child, and kill it where it finishes no case; returns its status, and whether it hung."""
    last, since_s, hangs = b"", time.monotonic(), False
    while True:
        ended, status = os.waitpid(child, os.WNOHANG)
        if ended:
            return status, hangs
        if shared[:8] != last:
            last, since_s = shared[:8], time.monotonic()
        elif time.monotonic() - since_s > _SILENT_S:
            hangs = True
            os.kill(child, signal.SIGKILL)
        time.sleep(0.05)


def _run(kind: Format, seed: int, numbers: range, shared: mmap.mmap, notes: Any, keep: Path) -> None:
    """What a child does; it ends with status 0 behind the last case, with 1 behind one that took too much memory."""
    status = 1
    try:
        faulthandler.enable()
        with _folder() as folder:
            begin = _peak_bytes()
            limit = 4 * kind.most_bytes + _virtual_bytes()
            resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
            tally, written = Tally(kind.name), 0

            def tell(number: int) -> None:
                counts = (tally.taken, tally.refused, tally.longest_s, tally.longest, tally.memory_bytes)
                _AT.pack_into(shared, 0, number, *counts)

            for number in numbers:
                tell(number)
                before = tally.taken, tally.refused
                _count(tally, kind, seed, number, folder, kind.most_s)
                tally.memory_bytes = max(tally.memory_bytes, _peak_bytes() - begin)
                grown = tally.memory_bytes > kind.most_bytes
                if grown and not (tally.finds and tally.finds[-1].number == number):
                    tally.taken, tally.refused = before
                    tally.finds.append(Find(kind.name, number, f"takes {tally.memory_bytes / 1e9:.1f} GB", ""))
                for find in tally.finds[written:]:
                    notes.write(json.dumps([find.number, find.what, find.trace]) + "\n")
                    notes.flush()
                    if sum(each.what[:60] == find.what[:60] for each in tally.finds) <= _KEPT_OF_A_KIND:
                        _keep(keep, kind, seed, find)
                written = len(tally.finds)
                tell(number)
                if grown:
                    break
            else:
                status = 0
    except BaseException:
        traceback.print_exc()
    finally:
        sys.stdout.flush()
        os._exit(status)


def _peak_bytes() -> int:
    return 1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss


def _virtual_bytes() -> int:
    return int(Path("/proc/self/statm").read_text(encoding="ascii").split()[0]) * resource.getpagesize()


def _keep(keep: Path, kind: Format, seed: int, find: Find) -> None:
    """Write a find into a folder: its input, and what happened."""
    keep.mkdir(parents=True, exist_ok=True)
    name = f"{kind.name}-{seed}-{find.number}"
    made = case(kind, seed, find.number)
    (keep / f"{name}.input").write_bytes(made if isinstance(made, bytes) else repr(made).encode("utf-8", "replace"))
    (keep / f"{name}.txt").write_text(f"{find.what}\n\n{find.trace}", encoding="utf-8", errors="replace")
