"""The house: its rooms as drawn, as they are and as the contract has them; no circle of files; what a room may take."""

import ast
import importlib.machinery
import importlib.util
import re
import sys
import tomllib

import pytest

import microrad
from places import ROOT

PACKAGE = ROOT / "src" / "microrad"
ROOMS = next(
    contract["layers"]
    for contract in tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["importlinter"][
        "contracts"
    ]
    if contract["type"] == "layers"
)[1:]


@pytest.fixture(scope="module")
def house():
    loader = importlib.machinery.SourceFileLoader("house_script", str(ROOT / "scripts" / "house"))
    made = importlib.util.module_from_spec(importlib.util.spec_from_loader(loader.name, loader))
    sys.modules[loader.name] = made  # where its records look for their names
    loader.exec_module(made)
    return made


@pytest.mark.promise("decisions-2")
def test_the_rooms_are_those_of_the_contract_and_nothing_else_stands_beside_them():
    beside = {"__init__.py", "__init__.pyi", "__main__.py", "py.typed", "__pycache__"}
    assert {path.name for path in PACKAGE.iterdir()} - beside == set(ROOMS)
    assert len(ROOMS) == 13


ASKING = {"socket", "http", "urllib", "ftplib", "requests", "httpx", "aiohttp", "urllib3"}
"""Modules by which a program asks others over the network."""


@pytest.mark.promise("decisions-1", "readme-8", "studio-30")
def test_nothing_in_the_package_asks_the_network():
    """The studio answers, and quotes addresses; tables of the Earth's rotation are those that skyfield brings along."""
    found, loaded = set(), []
    for path in PACKAGE.rglob("*.py"):
        text = path.read_text(encoding="utf-8")
        loaded += re.findall(r"load\.timescale\((.*?)\)", text)
        if not re.search(rf"\b(?:{'|'.join(ASKING)})\b", text):  # nothing to parse for
            continue
        for node in ast.walk(ast.parse(text)):
            names = [each.name for each in node.names] if isinstance(node, ast.Import) else []
            names += [node.module or ""] if isinstance(node, ast.ImportFrom) and not node.level else []
            found |= {
                (name, path.relative_to(PACKAGE).as_posix()) for name in names if name.partition(".")[0] in ASKING
            }
    assert loaded and set(loaded) == {"builtin=True"}
    assert {name for name, path in found if not path.startswith("studio/")} == set()
    assert {name for name, _ in found} <= {"socket", "urllib.parse", "http"}


DECISIONS = (ROOT / "docs" / "decisions.md").read_text(encoding="utf-8")


@pytest.mark.promise("decisions-2")
def test_the_page_of_decisions_lists_the_rooms_in_their_order():
    section = DECISIONS.partition("## The rooms")[2].partition("## ")[0]
    assert "thirteen rooms" in section
    assert re.findall(r"`(\w+)`", section.partition(": ")[2].partition("Whoever")[0]) == ROOMS


@pytest.mark.promise("decisions-3")
def test_what_is_not_used_is_no_dependency_and_no_import():
    """Integration step by step is left to benchmarks, tests and evidence: hysteresis is advanced exactly."""
    pinned = (ROOT / "constraints.txt").read_text(encoding="utf-8").lower()
    own = (path for path in PACKAGE.rglob("*.py") if "verification" not in path.parts)
    texts = [path.read_text(encoding="utf-8") for path in own]
    for name in ("slycot", "poliastro", "hapsira", "sippy", "sippy-unipi", "pint", "unyt"):
        assert re.search(rf"(?m)^{name}==", pinned) is None, name
        assert not any(re.search(rf"(?m)^\s*(?:import|from) {name}\b", text) for text in texts), name
    assert not any(re.search(r"\bPool\(|\bastropy\b.*import|solve_ivp|odeint", text) for text in texts)


def test_tests_stand_in_folders_of_the_same_names():
    folders = {path.name for path in (ROOT / "tests").iterdir() if any(path.glob("test_*.py"))}
    assert folders == set(ROOMS)


def test_the_house_is_drawn_with_the_rooms_of_the_contract_and_listed_in_its_order():
    text = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    picture = text.partition("```text\n")[2].partition("```")[0]
    assert sorted(word for word in re.findall(r"\w+", picture) if word in ROOMS) == sorted(ROOMS)
    assert [line.split("`")[1] for line in text.splitlines() if line.startswith("| `")][: len(ROOMS)] == ROOMS


def test_every_file_and_name_that_the_recipes_give_is_there():
    text = " ".join((ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8").partition("## Add ")[2].split())
    paths = set(re.findall(r"`([\w.-]+/[\w./-]+)`", text))
    named = set(re.findall(r"`(\w+)`(?: there)? in `([\w./-]+\.py)`", text))
    assert len(paths) > 30 and len(named) > 10
    assert [path for path in sorted(paths) if not _found(path).exists()] == []
    missing = [
        f"{name} in {path}"
        for name, path in sorted(named)
        if not re.search(rf"(?m)^(?:def |class )?{name}\b", _found(path).read_text(encoding="utf-8"))
    ]
    assert missing == []


def _found(path):
    return next((at for at in (PACKAGE / path, ROOT / path) if at.exists()), ROOT / path)


def test_the_public_names_are_known_to_type_checkers(house):
    stub = (PACKAGE / "__init__.pyi").read_text(encoding="utf-8")
    assert stub == house.stub(microrad._PUBLIC), "run scripts/house stub"


def test_circles_are_found(house):
    assert house.circles({"a": {"b"}, "b": {"c"}, "c": {"b"}, "d": {"a"}}) == [["b", "c"]]
    assert house.circles({"a": {"b"}, "b": set()}) == []


def test_places_that_take_a_mission_are_found(house, tmp_path, monkeypatch):
    package = tmp_path / house.PACKAGE
    package.mkdir()
    (package / "a.py").write_text(
        "class Study:\n    file: MissionFile\n\n\ndef one(m: Mission, x: float, of: 'LinkFile | None') -> Study: ...\n"
        "def two(study: Study) -> Mission: ...\n",
        encoding="utf-8",
    )
    monkeypatch.setattr(house, "ROOT", tmp_path)
    found = house.modules()
    assert [text.split(":")[0] for _, _, text in house.places(found, house.MISSIONS)] == ["m", "of"]
    assert house.holders(found) == house.MISSIONS | {"Study"}
    assert len(house.places(found, house.holders(found))) == 3


def test_lines_of_code_are_counted_without_prose(house):
    text = '"""Prose."""\n\n# more\nx = 1  # said\n\n\ndef f():\n    """Prose."""\n    return [\n        x,\n    ]\n'
    assert house.code_lines(text) == 5
