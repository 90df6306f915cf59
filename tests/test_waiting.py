"""The tests themselves: none measures time, and none has a limit of its own for what may take long."""

import ast
import re
import subprocess
import sys

import pytest

import waiting
from places import ROOT, TESTS

CLOCKS = {"perf_counter", "monotonic", "process_time", "thread_time", "perf_counter_ns", "monotonic_ns", "timeit"}
LIMITED = {
    "wait",
    "join",
    "set_default_timeout",
    "set_default_navigation_timeout",
    "wait_for_timeout",
    "Timer",
    "alarm",
}
"""Calls whose first argument is a time."""
EXEMPT = {"waiting.py", "campaign_target.py", "kills.py"}
"""Where the limit is, work that only sleeps, and kills at moments in the time that a command takes."""
CLOCK = "test_campaign_engines.py: monotonic"
"""The halt of a campaign is a jump of its clock, of which nothing is asserted."""


NUMBER = r"""(?:[^\s\w)]|\d|True|False|not\b|lambda\b|[fbr]+["'])"""
MAY_BE = re.compile(
    rf"\b(?:{'|'.join(sorted(CLOCKS))})\b|time\.time\(|\bfrom\s+time|timeout\w*\s*=|\bsleep\(\s*(?!0\))"
    rf"|(?<![\"']\.)\b(?:{'|'.join(sorted(LIMITED))})\(\s*{NUMBER}"
)
"""What a file with a fault has in its text: those without it need not be parsed."""


def faults(text, name):
    """What in a file of tests depends on how fast the machine is: place and what is wrong."""
    found = []
    if not MAY_BE.search(text):
        return found
    asks_clock = "time.time()" in text
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Attribute) and node.attr in CLOCKS and f"{name}: {node.attr}" != CLOCK:
            found.append((node.lineno, f"measures time by {node.attr}"))
        elif asks_clock and isinstance(node, ast.Assert) and "time.time()" in ast.unparse(node):
            found.append((node.lineno, "asserts what the clock says"))
        elif isinstance(node, ast.ImportFrom) and node.module in ("time", "timeit"):
            found.append((node.lineno, f"takes a clock from {node.module}"))
        elif isinstance(node, ast.Call):
            found += [(node.lineno, words) for words in in_call(node)]
    return [f"{name}:{line}: {words}" for line, words in sorted(found)]


def in_call(call):
    """A limit that a call sets for itself, or a sleep that hopes."""
    verb = call.func.attr if isinstance(call.func, ast.Attribute) else getattr(call.func, "id", "")
    for given in call.keywords:
        if given.arg is not None and "timeout" in given.arg and is_number(given.value):
            yield f"a limit of its own: {given.arg}={ast.unparse(given.value)}"
    of_text = isinstance(getattr(call.func, "value", None), ast.Constant)  # ", ".join
    if verb in LIMITED and not of_text and call.args and is_number(call.args[0]):
        yield f"a limit of its own: {ast.unparse(call)[:80]}"
    if verb == "sleep" and not (call.args and ast.unparse(call.args[0]) == "0"):
        yield "hopes that something has happened after a sleep"


def is_number(node):
    """Whether it is a number that stands there, be it in a product."""
    return not any(isinstance(part, ast.Name | ast.Attribute | ast.Starred) for part in ast.walk(node)) and any(
        isinstance(part, ast.Constant) and isinstance(part.value, int | float) for part in ast.walk(node)
    )


@pytest.mark.parametrize("path", sorted(TESTS.rglob("*.py")), ids=lambda path: path.name)
def test_no_test_asserts_a_time_or_has_a_limit_of_its_own(path):
    found = [] if path.name in EXEMPT else faults(path.read_text("utf-8"), path.name)
    assert found == [], "wait for an event by waiting.until, or with waiting.HANG_S"


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("began = time.perf_counter()", "measures time by perf_counter"),
        ("assert time.time() - began < 1", "asserts what the clock says"),
        ("from time import monotonic", "takes a clock from time"),
        ("process.communicate(timeout=30)", "a limit of its own: timeout=30"),
        ("page.click(timeout=2 * 1000.0)", "a limit of its own: timeout=2 * 1000.0"),
        ("thread.join(5.0)", "a limit of its own: thread.join(5.0)"),
        ("page.wait_for_timeout(20)", "a limit of its own: page.wait_for_timeout(20)"),
        ("time.sleep(0.4)", "hopes that something has happened after a sleep"),
    ],
)
def test_what_depends_on_the_machine_is_told_by_file_and_line(text, words):
    assert faults(f"x = 1\n{text}\n", "test_x.py") == [f"test_x.py:2: {words}"]


@pytest.mark.parametrize(
    "text",
    [
        "process.communicate(timeout=HANG_S)",
        "', '.join(words)",
        "', '.join(['one'] * 2)",
        "await asyncio.sleep(0)",
        "thread.join()",
        "time.time()",
    ],
)
def test_what_does_not_depend_on_it_is_left_alone(text):
    assert faults(f"async def test():\n    {text}\n", "test_x.py") == []


def test_what_never_happens_fails_with_what_was_waited_for(monkeypatch):
    monkeypatch.setattr(waiting, "HANG_S", 0.0)
    with pytest.raises(pytest.fail.Exception, match="waited in vain for rain"):
        waiting.until(lambda: False, "rain")
    assert waiting.until(lambda: "rain", "rain") == "rain"


# ---------------------------------------------------------------------------------------------------- what hangs all
OF_MAKE = ROOT.joinpath("Makefile").read_text("utf-8").partition("SIDE_BY_SIDE := ")[2].partition("\n")[0].split()


def all_tests(folder, **texts):
    """A run of all tests of a folder, as `make unit` begins it; exit code and what was said."""
    for name, text in texts.items():
        (folder / f"{name}.py").write_text(text, "utf-8")
    command = [sys.executable, "-m", "pytest", "-p", "no:cacheprovider", *OF_MAKE, "."]
    ran = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=waiting.HANG_S, check=False)
    return ran.returncode, ran.stdout + ran.stderr


@pytest.mark.endurance
def test_a_process_of_tests_that_crashes_ends_the_run(tmp_path):
    fine = "import time\ndef test_one(): time.sleep(0.1)\ndef test_two(): time.sleep(0.1)\n"
    bad = "import os\ndef test_bad(): os.abort()\ndef test_behind(): pass\n"
    code, said = all_tests(tmp_path, test_a=bad, **{f"test_{name}": fine for name in "bcdefg"})
    assert code == 1 and "crashed while running 'test_a.py::test_bad'" in said


@pytest.mark.endurance
def test_a_run_of_all_tests_that_does_not_end_is_ended(tmp_path):
    limit = f"import sys\nsys.path.insert(0, {str(TESTS)!r})\nimport waiting\nwaiting.ALL_S = 0.25\n"
    limit += "def pytest_configure(config):\n    if not hasattr(config, 'workerinput'): waiting.end_all_later()\n"
    code, said = all_tests(tmp_path, conftest=limit, test_a="import time\ndef test_long(): time.sleep(86400)\n")
    assert code == 1 and "Timeout (0:00:01)!" in said
