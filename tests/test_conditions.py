"""The parts of conditions that tests have seen only one way are found."""

import importlib.machinery
import importlib.util
import sys
from types import ModuleType

import numpy as np
import pytest

from places import ROOT

SOURCE = '''"""A module."""
from __future__ import annotations


class Kind:
    """A kind."""

    def checked(self, number, values=()):
        """A number."""
        if not isinstance(number, int) or number < 0:
            raise ValueError("no number")
        if np.any(values > 1) and number > 5:
            raise ValueError("too much")
        kept = [each for each in (1, 2) if each > number]
        return "none" if not kept else kept
'''


@pytest.fixture(scope="module")
def conditions():
    loader = importlib.machinery.SourceFileLoader("conditions_script", str(ROOT / "scripts" / "conditions"))
    made = importlib.util.module_from_spec(importlib.util.spec_from_loader(loader.name, loader))
    sys.modules[loader.name] = made
    loader.exec_module(made)
    return made


def test_parts_that_went_one_way_alone_are_found_and_the_code_does_the_same(conditions, tmp_path, monkeypatch):
    text, parts = conditions.telling(SOURCE, "module")
    arrays, numbers = {"np.any(values > 1)", "values > 1"}, {"number < 0", "number > 5", "each > number"}
    assert {*parts.values()} == {*arrays, *numbers, "isinstance(number, int)", "kept"}
    ear = ModuleType("microrad_conditions")
    exec(conditions.EAR, vars(ear))
    monkeypatch.setitem(sys.modules, "microrad_conditions", ear)
    monkeypatch.setenv("MICRORAD_CONDITIONS", str(tmp_path))
    space: dict[str, object] = {"np": np}
    exec(text, space)
    kind = space["Kind"]()
    assert kind.checked(1, np.array([0, 3])) == [2] and kind.checked(2, np.array([0])) == "none"
    with pytest.raises(ValueError, match="no number"):
        kind.checked("1")
    said = {tuple(line.split("  ")[::2]) for line in conditions.one_way(parts, tmp_path)}
    assert said == {("never true", "number < 0"), ("never true", "number > 5")}
    with pytest.raises(ValueError, match="no number"):
        kind.checked(-1)
    said = {line.split("  ")[2] for line in conditions.one_way(parts, tmp_path)}
    assert said == {"number > 5"}


def test_conditions_of_refusals_are_told_from_others(conditions):
    _, parts = conditions.telling(SOURCE, "module")
    places = conditions.refusals(SOURCE)
    refused = {text for key, text in parts.items() if conditions._place(key) in places}
    assert refused == {"isinstance(number, int)", "number < 0", "np.any(values > 1)", "values > 1", "number > 5"}


def test_modules_of_the_package_can_be_told(conditions):
    for module, file in [*conditions.modules(ROOT / "src")][::40]:
        compile(conditions.telling(file.read_text(encoding="utf-8"), module)[0], str(file), "exec")
