"""Runs a command once for each of its writes and each way in which that can fail, and judges what it leaves.

The process that imports this is loaded with the shim, and forks for each run: modules and compiled loops are there
already. Files lie in one folder whose place is always the same, which is made anew for each run: `here`, where the
command runs, and beside it home, cache, state and temporary files of its user.
"""

import atexit
import contextlib
import ctypes
import gc
import hashlib
import os
import re
import select
import shutil
import signal
import subprocess
import sys
import threading
import traceback
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from fnmatch import fnmatch
from pathlib import Path
from typing import Any, NamedTuple

from waiting import HANG_S

SHIM = Path(__file__).with_name("shim.c")
KINDS = ("error", "short", "torn", "full", "denied", "killed", "power cut")
"""In the order of the shim, behind none. An error comes once, a full disk and a lost permission stay; torn is a kill in
the midst of a write; a power cut is a kill that takes with it what was not synced."""
_MAKES, _WRITES, _NAMES, _SYNCS, _MARKS = 1, 2, 4, 8, 16
_OF = {
    "error": _MAKES | _WRITES | _NAMES | _SYNCS | _MARKS,
    "short": _WRITES,
    "torn": _WRITES,
    "full": _MAKES | _WRITES,
    "denied": _MAKES | _NAMES | _MARKS,
    "killed": _MAKES | _WRITES | _NAMES | _SYNCS | _MARKS,
}
_WHOLE = ("ftruncate", "fallocate")  # writes that are done at once or not at all
_PLACES = {
    "HOME": "home",
    "XDG_CACHE_HOME": "home/cache",
    "XDG_STATE_HOME": "home/state",
    "TMPDIR": "temporary",
}


class Write(NamedTuple):
    """An operation: its number, the call, what it is, its file from the folder, whether a file is not synced yet."""

    number: int
    call: str
    does: int
    path: str
    unsynced: bool


class Case(NamedTuple):
    """A write that fails in one way; behind the last one there is the power cut that follows the command's end."""

    number: int
    call: str
    path: str
    kind: str


@dataclass(frozen=True)
class Command:
    """A command that writes, the files that it begins with, and how what it leaves is read.

    ``does`` runs it in the current folder and returns its exit code. Where that is refused because results are there,
    ``otherwise`` is what the refusal says to do. ``content`` has readers by pattern of the path: what of a file is the
    same in each run. ``named`` is a pattern of names that are others in each run, and what stands in their place.
    ``threads`` says that it leaves threads, so that it is not run in the process that forks. ``stays`` is a pattern of
    drafts that no later run takes away.
    ``partly`` has those of files that grow while the command runs: they fail where one is damaged.
    """

    name: str
    does: Callable[[], int]
    prepare: Callable[[Path], None] = lambda here: None
    otherwise: Callable[[], int] | None = None
    content: Mapping[str, Callable[[Path], Any]] = field(default_factory=dict)
    partly: Mapping[str, Callable[[Path], Any]] = field(default_factory=dict)
    threads: bool = False
    named: tuple[str, str] = ("^$", "")
    stays: str = ""


class Ended(NamedTuple):
    """How a run ended: its exit code, negative for a signal, what it said, and its log."""

    code: int
    said: str
    log: list[str]


def built(folder: Path) -> Path:
    """The shim, compiled into a folder."""
    made = folder / "shim.so"
    subprocess.run(
        ["cc", "-O1", "-Wall", "-shared", "-fPIC", "-o", str(made), str(SHIM), "-lpthread"],
        check=True,
        env={name: value for name, value in os.environ.items() if name != "LD_PRELOAD"},
    )
    return made


class Layer:
    """One place in which commands run, with the shim that this process is loaded with."""

    def __init__(self, base: Path, shim: Path) -> None:
        """Take the place.

        Args:
            base: An empty folder on a disk of this machine.
            shim: The library that this process is loaded with.
        """
        self.base, self.work = base.resolve(), base.resolve() / "work"
        self.here = self.work / "here"
        self._stands = (self.base / "begin", self.base / "end", self.work)
        self._known = set[str]()
        self._shim = ctypes.CDLL(str(shim))
        os.environ.update({name: str(self.work / place) for name, place in _PLACES.items()})
        ctypes.CDLL(None).prctl(36, 1, 0, 0, 0)  # PR_SET_CHILD_SUBREAPER: what a killed run leaves behind ends here

    def prepared(self, command: Command) -> None:
        """Make the folder that the runs of a command begin with, and run it here once: what it loads stays loaded."""
        self._fresh()
        with (self.base / "said").open("wb") as words, _told(words.fileno()), contextlib.chdir(self.here):
            command.prepare(self.here)
            shutil.rmtree(self.work / "temporary")  # this process lives on, and with it what it has there
            (self.work / "temporary").mkdir()
            self._keep("begin")
            if not command.threads:
                command.does()
        threads = len(list(Path("/proc/self/task").iterdir()))
        if threads > 1:
            raise RuntimeError(f"{command.name} has left {threads - 1} threads, beside which no process can be forked")

    def _fresh(self) -> None:
        shutil.rmtree(self.work, ignore_errors=True)
        for place in ("here", *_PLACES.values()):
            (self.work / place).mkdir(parents=True, exist_ok=True)

    def _keep(self, name: str) -> None:
        shutil.rmtree(self.base / name, ignore_errors=True)
        shutil.copytree(self.work, self.base / name, symlinks=True)

    def _again(self, name: str) -> None:
        shutil.rmtree(self.work, ignore_errors=True)
        shutil.copytree(self.base / name, self.work, symlinks=True)

    def run(self, does: Callable[[], int], number: int = 0, kind: str = "") -> Ended:
        """Run a command with a fault, or without one; it sees the files as they are."""
        log, said = self.base / "log", self.base / "said"
        gc.freeze()  # a run shares what is here, and does not look through it
        sys.stdout.flush()  # else what waits here to be printed is printed by the run, too
        with log.open("wb") as lines, said.open("wb") as words:
            child = os.fork()
            if child == 0:
                self._child(does, lines.fileno(), words.fileno(), number, KINDS.index(kind) + 1 if kind else 0)
            code = _waited(child)
        return Ended(code, said.read_text("utf-8", "replace"), log.read_text("utf-8").splitlines())

    def _child(self, does: Callable[[], int], log: int, words: int, number: int, kind: int) -> None:
        """In the forked process: run, and end as a program of Python does."""
        code = 70
        try:
            os.setsid()
            os.chdir(self.here)
            for stream in (1, 2):
                os.dup2(words, stream)
            self._shim.writes_arm(str(self.work).encode(), log, number, kind)
            code = does()
        except BaseException:
            traceback.print_exc()
        threading._shutdown()
        atexit._run_exitfuncs()
        for stream in (sys.stdout, sys.stderr):
            with contextlib.suppress(OSError):
                stream.flush()
        ctypes.CDLL(None).exit(code)  # libraries take leave, as HDF5 of its files; modules need not be taken apart

    # -------------------------------------------------------------------------------------------------------- the list
    def writes(self, command: Command) -> list[Write]:
        """What a command writes while nothing fails; its files are kept as those of the undisturbed run."""
        self._again("begin")
        found = self.run(command.does)
        if found.code not in (0, 1):
            raise RuntimeError(f"{command.name} fails without a fault: {found.code}\n{found.said}")
        self._keep("end")
        self._unseen(found.log)
        self._again("begin")
        self._known = {self._stand()}
        return _parsed(found.log)

    def _unseen(self, log: list[str]) -> None:
        """Raises RuntimeError where a file is new or another one that the log has not seen: the layer is blind then."""
        seen = {line.split("\t", 5)[5] for line in log if line[0] in "wnt"}
        old, new = (_files(folder) for folder in self._stands[:2])
        changed = [
            name for name, path in new.items() if path.is_file() and (name not in old or not _equal(path, old[name]))
        ]
        names = {
            line.split("\t", 5)[5] for line in log if "\trename\t" in line or "\tlink\t" in line or "\tmkdir\t" in line
        }
        blind = [
            name
            for name in changed
            if name not in seen and not any(name == n or name.startswith(n + "/") for n in names)
        ]
        if blind:
            raise RuntimeError(f"written without the layer: {', '.join(blind)}")

    def cases(self, command: Command) -> list[Case]:
        """Each write with each way in which it can fail."""
        writes = self.writes(command)
        found = []
        for write in writes:
            for kind, of in _OF.items():
                if write.does & of and not (kind in ("short", "torn") and write.call in _WHOLE):
                    found.append(Case(write.number, write.call, write.path, kind))
            if write.unsynced:
                found.append(Case(write.number, write.call, write.path, "power cut"))
        return [*found, Case(len(writes) + 1, "end", ".", "power cut")]

    # --------------------------------------------------------------------------------------------------------- a case
    def faults(self, command: Command, case: Case) -> list[str]:
        """What is wrong behind a write that failed: nothing, as it should be."""
        self._again("begin")
        ended = self.run(command.does, case.number, case.kind)
        found = _badly_ended(ended, case)
        if case.kind == "power cut":
            _cut(self.work, ended.log)
        found += [f"left: {each}" for each in self._left(command, whole=ended.code in (0, 1))]
        if ended.code == 2:
            found += self._badly_said(command, ended.said)
        stand = self._stand()
        if not found and stand in self._known:
            return []  # the next run has gone on from just these files
        again = self.run(command.does)
        refused = again.code not in (0, 1)
        if refused and command.otherwise is not None:
            again = self.run(command.otherwise)
            refused = again.code not in (0, 1)
        found += [f"again: {each}" for each in self._left(command, whole=True, last=True)]
        if refused and (found or "Traceback" in again.said or not self._is_there(again)):
            found.append(f"again: {again.code} {again.said.strip()[-300:]}")
        if not found:
            self._known.add(stand)
        return found

    def _stand(self) -> str:
        """All files as they are, by a hash, with the names of drafts as if their processes had one number."""
        found = hashlib.sha256()
        for name, path in sorted((re.sub(r"-\d+-\w+", "", name), path) for name, path in _files(self.work).items()):
            content = path.read_bytes() if path.is_file() else b""
            found.update(f"{name}\0{path.is_file()}{path.stat().st_mode}\0{len(content)}\0".encode() + content)
        return found.hexdigest()

    def _badly_said(self, command: Command, said: str) -> Iterator[str]:
        """What is wrong with a refusal: it is one line, names where it happened, and is true."""
        words = said[said.rfind("microrad: ") :].strip()
        if "\n" in words:
            yield f"says more than a line: {words}"
        old, new, now = (_files(folder, command.named) for folder in self._stands)
        if not any(piece in words for name in (*old, *new) for piece in Path(name).parts):
            yield f"names no file: {words}"
        if re.search(r"nothing was written(?! there)|nothing is", words):
            for name, path in now.items():
                kept = name.startswith("here/") and not _DRAFT.search(name) and _of(command.partly, name) is None
                if kept and (name not in old or not _equal(path, old[name])):
                    yield f"says that nothing is written, and {name} is: {words}"

    @staticmethod
    def _is_there(ended: Ended) -> bool:
        """Whether a run was refused because what it would write is there already."""
        return ended.code == 2 and bool(re.search(r"exists|already", ended.said))

    def _left(self, command: Command, whole: bool, last: bool = False) -> Iterator[str]:
        """Files that are not as before or as the undisturbed run leaves them; and, of a whole run, those that lack.

        What is not whole yet, and what grows, may be there before the ``last`` run. What is kept for other runs has a
        digest and does not wait for the disk, so that a power cut may empty it until the next run makes it anew.
        """
        old, new, now = (_files(folder, command.named) for folder in self._stands)
        for name, path in now.items():
            partly = _of(command.partly, name)
            if name not in new and _DRAFT.search(name):
                if last and not fnmatch(name, command.stays):
                    yield f"{name} stays"
            elif path.is_dir() and any(each.startswith(f"{name}/") for each in (*old, *new)):
                continue
            elif name not in old and name not in new and (last or partly is None):
                yield f"{name} is none of the command's"
            elif partly is not None and (not (whole and name in new) or (name.startswith("home/cache/") and not last)):
                if not _reads(partly, path):
                    yield f"{name} is not in order"
            else:
                like = [each[name] for each in ((new,) if whole else (old, new)) if name in each]
                if like and not any(_same(command, name, path, each) for each in like):
                    yield f"{name} ({path.stat().st_size} bytes) is not whole"
        if whole:
            for name, path in new.items():
                if name not in now and path.is_file() and (last or _of(command.partly, name) is None):
                    yield f"{name} lacks"


_DRAFT = re.compile(r"(^|/)\.[^/]*(\.draft|\.part|\.old|\.new)(/|$)|(^|/)\.new-|^temporary/|\.part(-\w+)?$")
"""What is not whole yet has such a name."""


def _of(readers: Mapping[str, Any], name: str) -> Any:
    return next((reader for pattern, reader in readers.items() if fnmatch(name, pattern)), None)


def _reads(reader: Callable[[Path], Any], path: Path) -> bool:
    """Whether a file can be read: it is whole then, as far as it is written."""
    try:
        reader(path)
    except Exception:
        return False
    return True


def _same(command: Command, name: str, path: Path, like: Path) -> bool:
    if _equal(path, like):
        return True
    reader = _of(command.content, name)
    if reader is None:
        return False
    with contextlib.suppress(Exception):  # it cannot be read: it is not whole
        return bool(reader(path) == reader(like))
    return False


def _equal(path: Path, like: Path) -> bool:
    return path.is_file() == like.is_file() and (not path.is_file() or path.read_bytes() == like.read_bytes())


def _files(folder: Path, named: tuple[str, str] = ("^$", "")) -> dict[str, Path]:
    """Files, and folders without any, below a folder, by their names from there, with what is another each time."""
    found = {}
    for place, folders, files in os.walk(folder):
        for name in files if files or folders or Path(place) == folder else [""]:
            path = Path(place) / name
            found[re.sub(*named, str(path.relative_to(folder)))] = path
    return found


def _badly_ended(ended: Ended, case: Case) -> list[str]:
    """What is wrong with how a command ended: it succeeds, or says in a line why not, or is killed."""
    if case.call != "end" and not any(line[0] == "!" for line in ended.log):
        return ["the write was not met"]
    if case.kind in ("killed", "torn", "power cut") and case.call != "end":
        return [] if ended.code == -signal.SIGKILL else [f"ended with {ended.code} and was to be killed"]
    if "Traceback" in ended.said or ended.code not in (0, 1, 2):
        return [f"ended with {ended.code}: {ended.said.strip()[-1500:]}"]
    if ended.code == 2 and not re.search(r"^microrad: .+\S$", ended.said, re.MULTILINE):
        return [f"says nothing: {ended.said[-300:]!r}"]
    return []


def _parsed(log: list[str]) -> list[Write]:
    """The operations of a log."""
    found, synced = [], dict[str, int]()
    sizes = dict[str, int]()
    for line in log:
        mark, number, call, file, size, path = line.split("\t", 5)
        if mark == "?":
            unsynced = any(sizes[each] > synced.get(each, 0) for each in sizes)
            found.append(Write(int(number), call, int(size), path, unsynced))
        elif mark in "bntws":
            _noted(mark, file, int(size), sizes, synced)
    return found


def _noted(mark: str, file: str, size: int, sizes: dict[str, int], synced: dict[str, int]) -> None:
    """Keep of a line of the log how long a file is, and how long on the disk for good."""
    if mark == "b":  # what was there before the command is on the disk
        synced.setdefault(file, size)
    elif mark in "ns":
        synced[file] = size
    else:
        synced[file] = min(size, synced.get(file, size))
    sizes[file] = size


def _cut(work: Path, log: list[str]) -> None:
    """Cut each file to what was synced of it."""
    sizes, synced = dict[str, int](), dict[str, int]()
    for line in log:
        mark, _, _, file, size, _ = line.split("\t", 5)
        if mark in "bntws":
            _noted(mark, file, int(size), sizes, synced)
    for path in _files(work).values():
        found = path.stat()
        if path.is_file() and str(found.st_ino) in sizes:
            kept = synced.get(str(found.st_ino), 0)
            if found.st_size > kept:
                os.truncate(path, kept)


@contextlib.contextmanager
def _told(words: int) -> Iterator[None]:
    """Within it, what is printed goes elsewhere."""
    kept = [os.dup(stream) for stream in (1, 2)]
    sys.stdout.flush()
    for stream in (1, 2):
        os.dup2(words, stream)
    try:
        yield
    finally:
        sys.stdout.flush()
        for stream, copy in zip((1, 2), kept, strict=True):
            os.dup2(copy, stream)
            os.close(copy)


def _waited(child: int) -> int:
    """The exit code of a run; what it has started ends with it."""
    ending = os.pidfd_open(child)
    hangs = not select.select([ending], [], [], HANG_S)[0]
    os.close(ending)
    with contextlib.suppress(ProcessLookupError):
        os.killpg(child, signal.SIGKILL)
    code = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    with contextlib.suppress(ChildProcessError):
        while True:
            os.waitpid(-1, 0)
    if hangs:
        print(f"a run hangs: ended after {HANG_S} s", file=sys.stderr)
        return 99
    return code
