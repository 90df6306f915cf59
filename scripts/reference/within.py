"""What functions return, yield and raise while a test runs, held against reference/tests.

A test asserts what it is about, and passes through much more. With MICRORAD_WITHIN=hold, as `make within` sets it, a
test that has passed fails where a function inside of it returns something else than it did, or does so for arguments
near those of the test (`neighbours`). scripts/within writes that.
"""

import faulthandler
import json
import os
import sys
import time
import warnings
import zlib
from collections import defaultdict
from contextlib import suppress
from multiprocessing import get_context
from pathlib import Path

import pytest

from fuzzing.limits import TooLongError
from reference import inside, neighbours

MODE = os.environ.get("MICRORAD_WITHIN", "")
"""`hold`; or a folder to write values into: those that `held` in it names, or all; or nothing."""

HOLDS = MODE == "hold"
REFERENCE = Path(__file__).resolve().parents[2] / "reference" / "tests" if HOLDS else Path(MODE, "held")
BY_CHANCE = (
    *(*inside.BY_CHANCE, "cli.frame:_progress_lines", "cli.installation:", "cli.__init__:doctor"),
    *("core.integrity:", "core.threads:", "studio.jobs.", "studio.views.latest:", "studio.views.runs:time_words"),
    *("studio.guard.names:within", "campaign.rows.evaluate:_counts", "export.flight.stack:deepest.<locals>.below"),
    *(f"export.flight.write:{name}" for name in ("_cycles", "_measured", "report_text", "export_flight")),
)
"""Those, and functions whose values hang on the order of a set, change with each edit of the package, or name the
place where Python is."""

TESTS = str(Path(__file__).resolve().parents[2] / "tests")
CORES = os.cpu_count
FORKED = get_context("fork")

OF_FILE = 32
"""Values of a function that are written of a file of tests, each unlike the others."""

LOOKED = 4 * OF_FILE
"""Values of a function that are looked at for them."""

FIRST_CALLS = 5
"""Of a function in a test, that may be made again."""

COPIED = 500
"""Calls of a function whose arguments are copied, at most; those of the same arguments are made again once."""

VARIED = 3
"""Those that are made again with arguments that are near, too."""

NEAR_EACH = 16
"""Variations of each of these."""

TRIED_S = 1.0
"""Time for a function."""

DIRECTLY = 2
"""How many times as much of these there is for a function that tests call themselves: their arguments are about it."""


class Watching(inside.Watch):
    """Takes from a test what its functions return, and keeps calls to vary them when it has passed."""

    def __init__(self):
        """Nothing yet."""
        super().__init__()
        self._entered = defaultdict(int)
        self._kept = []

    def enters(self, name, frame):
        """A function is called: its arguments are copied where that call is varied."""
        if self._is_busy:
            return
        call = self._entered[name] = self._entered[name] + 1
        directly = frame.f_back is not None and frame.f_back.f_code.co_filename.startswith(TESTS)
        times = DIRECTLY if directly else 1
        if not (numbers := self.varies(name, call, times)):
            return
        self._is_busy = True
        try:
            if kept := neighbours.called(frame):
                self._kept.append((name, call, numbers, kept, times))
        finally:
            self._is_busy = False


class Holding(Watching):
    """Takes from a test what was held of it."""

    def __init__(self, held):
        """Its values, by function and call."""
        super().__init__()
        self._held = {name: {int(call) for call in calls} for name, calls in held.items()}
        self._varied = defaultdict(lambda: defaultdict(list))
        for name, calls in self._held.items():
            for call in sorted(calls) if name.endswith(neighbours.NEIGHBOURS) else ():
                self._varied[name.removesuffix(neighbours.NEIGHBOURS)][call // 100].append(call % 100)

    def varies(self, name, call, times):
        """How the arguments of a call are varied: as it is held."""
        return self._varied[name].get(call) if name in self._varied else None

    def vary(self):
        """What functions return for arguments near those that were kept."""
        for name, call, numbers, kept, _ in self._kept:
            for number, x in neighbours.values(kept, f"{name} {call}", numbers, neighbours.HANG_S):
                self.values[f"{name}{neighbours.NEIGHBOURS}"][f"{call}{number:02d}"] = x

    def takes(self, name):
        """Which call of a function this is, and 0 where its value is not taken."""
        if (held := self._held.get(name)) is None:
            return 0
        call = self._calls[name] = self._calls[name] + 1
        return call if call in held else 0


class OfFile:
    """Values of the functions in a file of tests."""

    def __init__(self):
        """Nothing yet."""
        self.looked = defaultdict(int)
        self.distinct = defaultdict(set)

    def new(self, values):
        """Those that no test of the file had before; calls that show a mistake are each another one."""
        found = defaultdict(dict)
        for name, calls in values.items():
            for call, x in calls.items():
                if name.endswith(neighbours.NEIGHBOURS) or round(x, 2) not in self.distinct[name]:
                    self.distinct[name].add(round(x, 2))
                    found[name][call] = x
        return found


class Tried:
    """Calls of a function that were made again, with mistakes."""

    def __init__(self):
        """None yet."""
        self.copied = self.varied = 0
        self.given = set()
        self.took_s = 0.0
        self.shown = None

    def is_worth_it(self, times):
        """Whether a mistake is left, and so many times the usual time to look for it."""
        is_left = self.shown is None or bool(self.shown.left)
        return is_left and self.copied < times * COPIED and self.took_s < times * TRIED_S

    def numbers(self, arguments, times):
        """How a call is made again with its arguments: as it was, and the first ones in variations, too."""
        x = inside.value(arguments)
        if x in self.given:
            return ()
        self.given.add(x)
        if is_varied := self.varied < times * VARIED:
            self.varied += 1
        more = range(NEAR_EACH * self.varied, NEAR_EACH * (self.varied + 1)) if is_varied else ()
        return (neighbours.SAME, *(number % neighbours.SAME for number in more))


class Taking(Watching):
    """Takes values of each function until its file of tests has enough, and calls that show a mistake."""

    limit_s, varying_s = neighbours.LIMIT_S, 4.0
    """Processor time of one variation, and time for all of a test."""

    def __init__(self, of_file, tried):
        """What its file has so far, and of each function the calls that were made again in this process."""
        super().__init__()
        self._of_file, self.tried = of_file, tried
        self.shown = defaultdict(dict)

    def varies(self, name, call, times):
        """Whether a call may be made again: how is decided when its test has passed."""
        tried = self.tried[name]
        if call > FIRST_CALLS or not tried.is_worth_it(times):
            return None
        tried.copied += 1
        return (neighbours.SAME,)

    def vary(self):
        """Calls again, first each as it was, until the time is over."""
        end = time.monotonic() + self.varying_s
        for name, _, _, (function, *_), _ in self._kept:
            if self.tried[name].shown is None:
                self.tried[name].shown = neighbours.Shown(function)
        again = [(self.tried[each[0]].numbers(each[3][1], each[4]), each) for each in self._kept]
        calls = [(number, each) for numbers, each in again for number in numbers[:1]]
        calls += [(number, each) for numbers, each in again for number in numbers[1:]]
        while calls and time.monotonic() < end:
            calls = calls[self._made_again(calls, end) :]
            if calls and time.monotonic() < end:
                _, (name, *_) = calls.pop(0)
                self.tried[name].took_s = DIRECTLY * TRIED_S  # it has ended the process

    def _made_again(self, calls, end):
        """How many calls were made again, in a child: arguments that no caller gives, or mistakes, may end it."""
        ours, theirs = FORKED.Pipe(duplex=False)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", DeprecationWarning)  # of threads, which a child leaves alone
            child = FORKED.Process(target=self._send, args=(theirs, calls))
            child.start()
        theirs.close()
        made, heard = 0, time.monotonic()
        with ours, suppress(EOFError):
            while made < len(calls):
                number, (name, call, *_) = calls[made]
                if not ours.poll(max(end - time.monotonic(), 0.0)):
                    self.tried[name].took_s += time.monotonic() - heard
                    break
                x, shown, took_s = ours.recv()
                made, heard = made + 1, time.monotonic()
                self.tried[name].took_s += took_s
                if shown:
                    self.tried[name].shown.left.difference_update(shown)
                    self.values[f"{name}{neighbours.NEIGHBOURS}"][f"{call}{number:02d}"] = x
                    self.shown[f"{name}{neighbours.NEIGHBOURS}"][f"{call}{number:02d}"] = shown
        child.kill()
        child.join()
        return made

    def _send(self, theirs, calls):
        """What each returns, the mistakes that it shows, and seconds."""
        faulthandler.disable()
        for number, (name, call, _, kept, times) in calls:
            tried, began, of = self.tried[name], time.monotonic(), (0.0, [])
            if tried.shown.left and tried.took_s < times * TRIED_S:
                with suppress(Exception, TooLongError):  # arguments that refuse to be such, or that take too long
                    if (changed := neighbours.varied(kept, f"{name} {call}", number)) is not None:
                        of = tried.shown.by(changed, self.limit_s, times * TRIED_S - tried.took_s)
            tried.took_s += time.monotonic() - began
            theirs.send((*of, time.monotonic() - began))

    def takes(self, name):
        """Which call of a function this is, and 0 where its value is not taken."""
        call, of_file = super().takes(name), self._of_file
        if not call or of_file.looked[name] >= LOOKED or len(of_file.distinct[name]) >= OF_FILE:
            return 0
        of_file.looked[name] += 1
        return call


class Within:
    """Watches each test that runs."""

    def __init__(self):
        """No test yet."""
        self._file = ""
        self._held = Held()
        self._of_file = OfFile()
        self._tried = defaultdict(Tried)
        self._caches = Caches()

    def pytest_collection_modifyitems(self, items):
        """Of those that are held alone, where it is asked whether others agree."""
        if not HOLDS and REFERENCE.exists():
            items[:] = [item for item in items if self._held[place(item)[0]].keys() & set(places(item))]

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_call(self, item):
        """Fail a test inside of which something is another one; or write what there is."""
        return (yield from self._watched(*place(item), item.name))

    @pytest.hookimpl(wrapper=True)
    def pytest_fixture_setup(self, fixturedef, request):
        """The same for what a test, or all tests of a file, get."""
        if fixturedef.scope not in ("function", "module"):  # whoever is the first sets up the others
            return (yield)
        name = f"@{fixturedef.argname}{getattr(request, 'param_index', 0)}"
        return (yield from self._watched(*place(request.node, name), name))

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_teardown(self, item):
        """A test that has changed the number of cores puts back what it found."""
        try:
            return (yield)
        finally:
            os.cpu_count = CORES

    def _watched(self, file, test, name):
        if file != self._file:
            self._file, self._of_file = file, OfFile()
        held = self._held[file].get(test, {})
        if not held and (HOLDS or REFERENCE.exists()):
            return (yield)
        watch, outer = Holding(held) if held else Taking(self._of_file, self._tried), inside.Watch.current
        self._caches.clear()
        os.cpu_count = lambda: 1  # work is cut into parts by their number, and threads take turns
        inside.Watch.current = watch
        began = time.perf_counter()
        try:
            result = yield
        finally:
            inside.Watch.current = outer
            os.cpu_count = CORES
        took_s = time.perf_counter() - began
        watch.vary()
        if not HOLDS:
            if found := watch.values if held else self._of_file.new(watch.values):
                shown = {} if held else watch.shown
                with Path(MODE, f"{os.getpid()}.jsonl").open("a", encoding="utf-8") as out:
                    out.write(json.dumps([file, test, took_s, found, shown]) + "\n")
        elif moved := inside.moved(name, held, watch.values):
            pytest.fail("\n".join([*moved, f"Where that is meant: scripts/within tests/{file}"]), pytrace=False)
        return result


class Caches:
    """Those of the package's functions: what one test leaves in them the next one would not ask for again."""

    def __init__(self):
        """None yet."""
        self._modules = set()
        self._known = []

    def clear(self):
        """Empty all of the modules that are loaded by now."""
        for name in [each for each in sys.modules if each.startswith("microrad.") and each not in self._modules]:
            self._modules.add(name)
            of = [sys.modules[name], *(each for each in vars(sys.modules[name]).values() if isinstance(each, type))]
            cached = [getattr(each, "__func__", each) for part in of for each in vars(part).values()]
            self._known += [each for each in cached if callable(getattr(each, "cache_clear", None))]
        for each in self._known:
            each.cache_clear()


class Held(dict):
    """What is held of a file of tests: values by test, function and call."""

    def __missing__(self, file):
        """Read it."""
        found = self[file] = defaultdict(lambda: defaultdict(dict))
        for name, values in inside.load(REFERENCE / Path(file).with_suffix(".txt")).items():
            for key, x in values.items():
                test, call = key.split(".")
                found[test][name][call] = x
        return found


def place(node, more=""):
    """File of a test, and eight letters for its name; or of a fixture, by what it is of."""
    file, _, name = node.nodeid.removeprefix("tests/").partition("::")
    return file, f"{zlib.crc32((name + more).encode()):08x}"


def places(item):
    """Those eight letters of a test, and of all its fixtures without parameters or with the first one."""
    names = [f"@{name}0" for name in item.fixturenames]
    return [place(each, name)[1] for each in (item, item.getparent(pytest.Module)) for name in ("", *names)]


if MODE:
    inside.tell(BY_CHANCE, neighbours.LEFT_OUT)
