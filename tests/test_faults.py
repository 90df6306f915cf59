"""The seeded faults of faults/*.toml: each is still found in the code, by its function and text, and changes it.

Here the text of each is looked for in its file, and those of one module in eight are planted; `make endurance` plants
every one.
"""

import ast
import importlib.machinery
import importlib.util
import os
import queue
import shutil
import subprocess
import sys
from collections import Counter
from pathlib import Path

import pytest

from places import ROOT


@pytest.fixture(scope="module")
def faults():
    loader = importlib.machinery.SourceFileLoader("faults_script", str(ROOT / "scripts" / "faults"))
    made = importlib.util.module_from_spec(importlib.util.spec_from_loader(loader.name, loader))
    sys.modules[loader.name] = made  # where its records look for their names
    loader.exec_module(made)
    return made


def test_each_fault_is_found_once_and_changes_the_code(faults):
    every, texts = faults.every(), {}
    modules = sorted({fault.module for fault in every})[:: 1 if os.environ.get("MICRORAD_ENDURANCE") else 8]
    for fault in every:
        if fault.module not in texts:
            texts[fault.module] = fault.file(ROOT).read_text(encoding="utf-8")
        assert fault.text in texts[fault.module], fault.name
        if fault.module in modules:
            fault.planted(texts[fault.module])
    assert len(every) >= 220
    assert min(Counter(fault.area for fault in every).values()) >= 4
    assert len({fault.kind for fault in every}) >= 7


def test_faults_of_units_stand_where_the_code_converts_twelve_of_each_kind(faults):
    spec = importlib.util.spec_from_file_location("unit_places", ROOT / "scripts" / "unit_places.py")
    places = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(places)
    drawn = [(fault.kind, fault.function) for fault in faults.listed(ROOT / "faults" / "units.toml")]
    assert Counter(kind for kind, _ in drawn) == dict.fromkeys(places.KINDS, 12)
    assert len(set(drawn)) == len(drawn)
    sources = {fault.file(ROOT): fault.module for fault in faults.listed(ROOT / "faults" / "units.toml")}
    found = set()
    for file, module in sources.items():
        text = file.read_text(encoding="utf-8")
        found |= {each[:2] for each in places._inside(ast.parse(text), f"{module}:", text.splitlines())}
    assert found >= set(drawn)


@pytest.mark.parametrize(
    ("text", "message"), [("def not_there", "occurs 0 times"), ("e", "times in"), ("", "times in")]
)
def test_a_fault_that_is_not_there_once_is_told(faults, text, message):
    fault = faults.Fault("x", "link", "sign", "microrad.core.threads:in_threads", text, "pass", "")
    with pytest.raises(ValueError, match=message):
        fault.planted(fault.file(ROOT).read_text(encoding="utf-8"))


def test_a_fault_that_changes_nothing_is_told(faults):
    fault = faults.Fault("x", "link", "sign", "microrad.core.threads:in_threads", "results = []", "results  =  []", "")
    with pytest.raises(ValueError, match="changes nothing"):
        fault.planted(fault.file(ROOT).read_text(encoding="utf-8"))


def test_a_function_that_is_gone_is_told(faults):
    fault = faults.Fault("x", "link", "sign", "microrad.core.threads:gone", "a", "b", "")
    with pytest.raises(ValueError, match="0 definitions of microrad"):
        fault.planted(fault.file(ROOT).read_text(encoding="utf-8"))


def test_the_table_is_that_of_the_results(faults):
    assert faults.table() in (ROOT / "faults" / "README.md").read_text(encoding="utf-8")


TWICE = "def in_threads(n):\n    return n * 2\n"
A_TEST = "from microrad.core.threads import in_threads\n\n\ndef test_{0}():\n    assert in_threads({0}) {1}\n"


@pytest.fixture
def tiny(faults, tmp_path, monkeypatch):
    """The script works on a tree of one module and two files of tests. Returns a mistake in it: n + 2 for 2 n."""
    tree, core = tmp_path / "tree", tmp_path / "tree" / "src" / "microrad" / "core"
    core.mkdir(parents=True)
    for file, text in {core.parent / "__init__.py": "", core / "__init__.py": "", core / "threads.py": TWICE}.items():
        file.write_text(text, encoding="utf-8")
    (tree / "tests").mkdir()
    (tree / "pytest.ini").write_text("[pytest]\n", encoding="utf-8")
    (tree / "scripts").mkdir()
    (tree / "scripts" / "numbers").write_text("# no case moves\n", encoding="utf-8")
    (tree / "tests" / "test_blunt.py").write_text(A_TEST.format(2, "== 4"), encoding="utf-8")
    (tree / "tests" / "test_sharp.py").write_text(A_TEST.format(3, "== 6"), encoding="utf-8")
    for words in (["init", "-q"], ["add", "."]):
        subprocess.run(["git", *words], cwd=tree, check=True)
    monkeypatch.setenv("PYTEST_DISABLE_PLUGIN_AUTOLOAD", "1")  # the tree's tests need none, and each takes its time
    monkeypatch.setattr(faults, "ROOT", tree)
    monkeypatch.setattr(faults, "SUITE", ())
    return faults.Fault("sum", "link", "sign", "microrad.core.threads:in_threads", "n * 2", "n + 2", "")


def test_the_file_that_catches_a_fault_is_named_and_the_code_is_as_before(faults, tiny, tmp_path):
    calling = faults.callers([tiny], tmp_path)["sum"]
    assert sorted(calling) == ["tests/test_blunt.py::test_2", "tests/test_sharp.py::test_3"]
    trees = queue.SimpleQueue()
    trees.put(faults.copied(tmp_path / "copy"))
    (tmp_path / "chosen.py").write_text(faults.CHOSEN, encoding="utf-8")
    blunt = {name: s for name, s in calling.items() if "blunt" in name}
    met = [faults.meet(trees, tiny, tests) for tests in (blunt, calling, None)]
    assert [(each.caught_by, each.whole_suite) for each in met] == [
        ("", False),
        ("test_sharp.py", False),
        ("test_sharp.py", True),
    ]
    assert (tmp_path / "copy/src/microrad/core/threads.py").read_text(encoding="utf-8") == TWICE


def test_tests_that_fail_without_a_fault_are_told_and_left_out(faults, tiny, tmp_path, capsys):
    (faults.ROOT / "tests" / "test_sharp.py").write_text(A_TEST.format(3, "== 7"), encoding="utf-8")
    assert list(faults.callers([tiny], tmp_path)["sum"]) == ["tests/test_blunt.py::test_2"]
    assert "left out, as they fail without a mistake: tests/test_sharp.py::test_3\n" in capsys.readouterr().out


@pytest.fixture(scope="module")
def two_rooms(tmp_path_factory):
    """A tree with two rooms of the package."""
    tree = tmp_path_factory.mktemp("rooms")
    for room in ("core", "link"):
        own = Path("src", "microrad", room)
        shutil.copytree(ROOT / own, tree / own, ignore=shutil.ignore_patterns("__pycache__"))
    return tree


def test_a_seed_draws_lines_of_functions_in_the_order_of_the_package(faults, two_rooms, monkeypatch):
    monkeypatch.setattr(faults, "ROOT", two_rooms)
    drawn = faults.drawn(7)
    assert (len(drawn), len(set(drawn)), faults.drawn(7)) == (faults.DRAWN, faults.DRAWN, drawn)
    assert faults.drawn(8) != drawn
    assert [line.partition(":")[0] for line in drawn] == sorted(line.partition(":")[0] for line in drawn)
    for place, text in (line.split(": ", maxsplit=1) for line in drawn):
        function, number = place.split(", ")
        fault = faults.Fault("x", "link", "sign", function, text, "", "")
        source = fault.file(ROOT).read_text(encoding="utf-8")
        assert source.splitlines()[int(number) - 1].strip() == text
        node = fault.node(source)
        assert node.body[0].lineno <= int(number) <= node.end_lineno


def test_lines_of_code_are_those_of_bodies(faults, tmp_path, monkeypatch):
    monkeypatch.setattr(faults, "ROOT", tmp_path)
    file = tmp_path / "src" / "microrad" / "link" / "__init__.py"
    file.parent.mkdir(parents=True)
    file.write_text(
        'A = 1\n\n\ndef f(a,\n      b):\n    """What it is.\n\n    More."""\n\n    # why\n    return a  # here\n\n\n'
        "class C:\n    x = 2\n\n    @property\n    def g(self):\n        def h():\n            return 3\n\n"
        "        return (h(),\n                4)\n",
        encoding="utf-8",
    )
    assert faults.code_of(file) == [
        "microrad.link:f, 11: return a  # here",
        "microrad.link:C.g, 19: def h():",
        "microrad.link:C.g, 20: return 3",
        "microrad.link:C.g, 22: return (h(),",
        "microrad.link:C.g, 23: 4)",
    ]


@pytest.mark.parametrize("given", [[], ["1", "2"], ["many"], ["1.5"]])
def test_a_draw_without_one_seed_is_refused(faults, monkeypatch, capsys, given):
    monkeypatch.setattr(sys, "argv", ["faults", "draw", *given])
    with pytest.raises(SystemExit, match="2"):
        faults.main()
    assert capsys.readouterr().err.endswith("error: draw takes one seed, a whole number\n")


def test_a_draw_is_printed_line_by_line(faults, two_rooms, monkeypatch, capsys):
    monkeypatch.setattr(faults, "ROOT", two_rooms)
    monkeypatch.setattr(sys, "argv", ["faults", "draw", "7"])
    assert faults.main() == 0
    assert capsys.readouterr().out.splitlines() == faults.drawn(7)
