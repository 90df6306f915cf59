"""Each write of a command fails in each way: what is left is whole or as it was, and the next run goes on.

Here a few cases of each kind; `make endurance` tries every one.
"""

import ast
import os
import re
import shutil
import subprocess
import sys

import pytest

from places import ROOT, TESTS
from waiting import ALL_S, HANG_S

pytestmark = pytest.mark.skipif(
    sys.platform != "linux" or shutil.which("cc") is None, reason="the layer needs Linux and a C compiler"
)

SCRIPT = ROOT / "scripts" / "faults_at_writes"
PACKAGE = ROOT / "src" / "microrad"
CALLS = {
    *("write_whole", "whole_folder", "whole_file", "draft_beside", "new_folder", "scratch", "scratch_folder"),
    *("write_text", "write_bytes", "mkdir", "mkdtemp", "savemat"),
}
"""Functions that write."""
PLANTED = """
import sys
from pathlib import Path
from writes.layer import Command, Layer

def does():
    {0}
    return 0

layer = Layer(Path(sys.argv[1]), Path(sys.argv[2]))
command = Command("planted", does, lambda here: (here / "a").write_text("old"))
layer.prepared(command)
for case in layer.cases(command):
    for found in layer.faults(command, case):
        print(f"{{case.call}}, {{case.kind}}: {{found}}")
"""


def run(*words, limit_s=HANG_S):
    return subprocess.run(
        [sys.executable, SCRIPT, *words], capture_output=True, text=True, timeout=limit_s, cwd=ROOT, check=False
    )


def cases(text):
    """The number of cases by kind, in the last line of the table."""
    return [int(number) for number in re.findall(r"^all +([\d ]+)$", text, re.MULTILINE)[0].split()]


@pytest.mark.promise("releasing-7")
def test_a_few_writes_of_a_few_commands():
    """What a campaign writes, a ledger, is damaged, killed and cut off in tests of its own."""
    done = run("--each", "40", "init", "bench --overwrite", "studio: job", "studio: save")
    assert (done.returncode, done.stderr) == (0, ""), done.stdout
    assert cases(done.stdout)[0] >= 10


@pytest.mark.promise("releasing-7")
@pytest.mark.endurance
def test_every_write_of_every_command():
    done = run("--all", limit_s=ALL_S)
    assert done.returncode == 0, done.stdout + done.stderr
    assert cases(done.stdout)[0] >= 2000


def planted(folder, body):
    """What is wrong with a command of one line, by the layer."""
    from writes.layer import built

    shim = built(folder)
    environment = {**os.environ, "LD_PRELOAD": str(shim), "PYTHONPATH": os.pathsep.join(map(str, (TESTS, *sys.path)))}
    words = [sys.executable, "-c", PLANTED.format(body), folder, shim]
    done = subprocess.run(words, capture_output=True, text=True, timeout=HANG_S, env=environment, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.mark.promise("releasing-7")
@pytest.mark.parametrize(
    ("body", "words"),
    [
        ('Path("a").write_text("new" * 9)', "write, torn: left: here/a (14 bytes) is not whole"),
        ('Path("b").write_text("new" * 9); Path("b").replace("a")', "end, power cut: left: here/a (0 bytes) is not wh"),
        ('Path(f"b{__import__(\'os\').getpid()}.part").write_text("new")', ".part stays"),
        ('Path("a").unlink(); Path("a").write_text("new")', "open, error: ended with 70: Traceback"),
    ],
    ids=["in its place", "not synced", "a name of its own each time", "without words"],
)
def test_a_writer_with_a_fault_is_told(tmp_path, body, words):
    assert words in planted(tmp_path, body)


def test_a_writer_without_a_fault_passes(tmp_path):
    body = """
    from microrad.core.folder import write_whole
    try:
        write_whole(Path("a"), "new")
    except OSError as error:
        print(f"microrad: {error.filename}: {error.strerror}")
        return 2
"""
    assert planted(tmp_path, body) == ""


@pytest.mark.promise("releasing-7")
def test_every_file_of_the_package_that_writes_has_its_command():
    from writes.commands import COMMANDS, WRITERS

    writing = {str(path.relative_to(PACKAGE)) for path in PACKAGE.rglob("*.py") if writes(path)}
    assert writing == set(WRITERS)
    names = [command.name for command in COMMANDS]
    assert len(set(names)) == len(names)
    assert sum(how in names for how in WRITERS.values()) == len(WRITERS) - 11


@pytest.mark.promise("releasing-8")
def test_the_page_has_each_way_and_its_cases_add_up():
    from writes.commands import COMMANDS
    from writes.layer import KINDS

    page = (ROOT / "docs" / "releasing.md").read_text(encoding="utf-8")
    rows = re.findall(r"(?m)^\| ([a-z ]+) \| ([^|]+) \| ([\d ]+) \|$", page)
    *ways, (last, commands, total) = [(name, what, int(count.replace(" ", ""))) for name, what, count in rows]
    assert tuple(name for name, *_ in ways) == KINDS
    assert last == "all" and 30 < int(commands.removesuffix(" commands")) <= len(COMMANDS)
    assert sum(count for *_, count in ways) == total


def writes(path):
    """Whether a file of the package calls what writes."""
    text = path.read_text("utf-8")
    if not re.search(rf"\b(?:{'|'.join(sorted(CALLS))}|open|connect)\(", text):  # nothing to parse for
        return False
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Call):
            name = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
            modes = [str(each.value) for each in node.args if isinstance(each, ast.Constant)]
            opens = name == "open" and any(re.fullmatch(r"[wax]b?|r\+b", mode) for mode in modes)
            if name in CALLS or opens or (name == "connect" and ast.unparse(node.func).startswith("sqlite3")):
                return True
    return False
