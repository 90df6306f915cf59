"""The flight code deviates from MISRA C:2012 where docs/export.md says so, and nowhere else."""

import importlib.machinery
import importlib.util
import os
import sys
from functools import cache

import pytest

import designs
from export.test_export_adaptive import learning
from export.test_export_flight import GENEROUS, PAIRS, pair
from microrad.export import choice
from microrad.export.flight.c_code import flight_code
from microrad.export.flight.fixed import fixed_code, quantised
from microrad.export.linear_part.sections import sections
from places import ROOT


@cache
def script():
    loader = importlib.machinery.SourceFileLoader("misra_script", str(ROOT / "scripts" / "misra"))
    made = importlib.util.module_from_spec(importlib.util.spec_from_loader(loader.name, loader))
    sys.modules[loader.name] = made  # where its records look for their names
    loader.exec_module(made)
    return made


PERMITTED = script().permitted((ROOT / "docs" / "export.md").read_text(encoding="utf-8"))


def floating(chosen, precision, name):
    of = choice.flight_controller(chosen)
    return flight_code(of, sections(of), name, precision, GENEROUS)


def whole(name):
    chosen = designs.chosen(name)
    of = choice.flight_controller(chosen)
    return fixed_code(of, sections(of), quantised(of, sections(of), choice.vectors(chosen, 2000)), "whole")


def inverses(models, precision):
    of, _ = pair(PAIRS[models])
    return flight_code(of, sections(of), "pair", precision, GENEROUS)


def learns(precision):
    of, vectors = learning(0.305e-3, samples=200)
    if precision == "fixed":
        return fixed_code(of, sections(of), quantised(of, sections(of), vectors), "learns")
    return flight_code(of, sections(of), "learns", precision, GENEROUS)


CODE = {
    "rate by difference": lambda: floating(designs.chosen("PID + inverse"), "double", "pid"),
    "inverse in series": lambda: floating(designs.chosen("PI + inverse in series"), "single", "series"),
    "feedback": lambda: floating(designs.chosen("resonant damping"), "double", "damping"),
    "several axes": lambda: floating(designs.of_three_actuators(), "single", "axes"),
    "fixed point": lambda: whole("resonant damping"),
    "fixed point with an inverse": lambda: whole("PI + inverse in series"),
    "plays and creep": lambda: inverses("printed, widening plays that creep", "single"),
    "an inverse that learns": lambda: learns("single"),
    "fixed point with an inverse that learns": lambda: learns("fixed"),
    "an exponent": lambda: inverses("exponent 2 without a limit of rate, plays that creep", "double"),
}
"""Code with each part that flight code may have."""
AGAIN = {
    *("rate by difference", "feedback", "plays and creep"),
    *("fixed point", "fixed point with an inverse", "an inverse that learns"),
}
"""What the others hold, too."""
HELD = CODE if os.environ.get("MICRORAD_ENDURANCE") else CODE.keys() - AGAIN

FOUND = {}
needs_checker = pytest.mark.skipif(script().checker() is None, reason="no cppcheck")


def found(name, folder):
    if name not in FOUND:
        for file, text in CODE[name]().items():
            (folder / file).write_text(text, encoding="utf-8")
        FOUND[name] = script().findings(folder)
    return FOUND[name]


@pytest.mark.promise("export-25", "export-39")
@needs_checker
@pytest.mark.parametrize("name", sorted(HELD))
def test_each_deviation_is_one_that_the_page_gives_a_reason_for(name, tmp_path):
    assert [each for each in found(name, tmp_path) if not script().is_permitted(each, PERMITTED)] == []


@pytest.mark.promise("export-25")
@needs_checker
def test_the_page_names_no_deviation_that_there_is_not(tmp_path):
    rules = set()
    for i, name in enumerate(HELD):
        folder = tmp_path / str(i)
        folder.mkdir()
        rules |= {each.rule for each in found(name, folder)}
    assert rules == {each.rule for each in PERMITTED}


@pytest.mark.promise("export-25", "export-26", "export-39")
@needs_checker
def test_a_rule_that_is_broken_is_said(tmp_path, capsys):
    """A jump, and a shift of a signed number outside the files for which the page permits one."""
    code = "int jump(int x);\nint jump(int x)\n{\n    goto end;\nend:\n    return x << 1;\n}\n"
    (tmp_path / "jump.c").write_text(code, encoding="utf-8")
    (tmp_path / "jump_bench.c").write_text(code, encoding="utf-8")  # a bench does not fly
    assert script().main([str(tmp_path)]) == 1
    said = capsys.readouterr().out
    assert f"{tmp_path / 'jump.c'}:4: rule 15.1, which docs/export.md names no deviation from" in said
    assert "jump.c:6: rule 10.1" in said
    assert "jump_bench" not in said


@pytest.mark.promise("export-39")
@needs_checker
def test_the_statement_counts_each_rule_with_its_reason(tmp_path, capsys):
    for file, text in CODE["feedback"]().items():
        (tmp_path / file).write_text(text, encoding="utf-8")
    assert script().main([str(tmp_path)]) == 0
    (line,) = (line for line in capsys.readouterr().out.splitlines() if line.split()[0] == "8.9")
    (of,) = (each for each in PERMITTED if each.rule == "8.9")
    assert line.endswith(f"times: {of.reason}")


def test_each_deviation_has_its_files_and_one_reason():
    assert len(PERMITTED) >= 4
    assert len({each.rule for each in PERMITTED}) == len(PERMITTED)
    assert all(each.files and len(each.reason) > 20 for each in PERMITTED)
