"""The seeded faults of faults/*.toml: each is still found in the code, by its function and text, and changes it."""

import importlib.machinery
import importlib.util
import sys
from collections import Counter

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
    every = faults.every()
    for fault in every:
        fault.planted(fault.file(ROOT).read_text(encoding="utf-8"))
    assert len(every) >= 80
    assert min(Counter(fault.area for fault in every).values()) >= 4
    assert len({fault.kind for fault in every}) >= 7


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
