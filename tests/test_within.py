"""What functions return inside of a test is held: one that returns something else fails the test that passed by it."""

import json
import zlib
from importlib.machinery import SourceFileLoader
from importlib.util import module_from_spec, spec_from_loader
from types import SimpleNamespace

import pytest

from places import ROOT
from reference import inside, neighbours, within

CODE = """
from contextlib import suppress
from functools import cache

@cache
def once():
    return part(7.0)

def part(x):
    return FACTOR * x

def refuse(x):
    raise ValueError(f"{x} is too much")

def comes_back(x):
    while x != 3.0:
        with suppress(BaseException):
            while True:
                pass
    return x

class Kept:
    @staticmethod
    @cache
    def method():
        return part(5.0)
"""


class Item(SimpleNamespace):
    """A test."""

    def __init__(self, name, *fixtures):
        super().__init__(nodeid=f"tests/link/test_x.py::{name}", name=name, fixturenames=fixtures)

    def getparent(self, _):
        return SimpleNamespace(nodeid="tests/link/test_x.py")


ITEM, OTHER = Item("test_it[1.5]"), Item("other", "plant")


@pytest.fixture
def code(tmp_path, monkeypatch):
    """A module of the package whose functions tell what they return; with another factor they return something else."""
    (tmp_path / "microrad").mkdir()
    file = tmp_path / "microrad" / "new.py"
    file.write_text(CODE, encoding="utf-8")
    monkeypatch.setattr(inside._Returns, "not_entered", ("new:refuse",))
    monkeypatch.setattr(within.Taking, "limit_s", neighbours.HANG_S)
    monkeypatch.setattr(within.Taking, "varying_s", neighbours.HANG_S)
    loader = inside.Telling("microrad.new", str(file))
    module = module_from_spec(spec_from_loader("microrad.new", loader))
    module.FACTOR = 2.0
    loader.exec_module(module)
    monkeypatch.setitem(within.sys.modules, "microrad.new", module)
    return module


def watched(plugin, test, item=ITEM):
    """What comes of a test that the plugin watches."""
    hook = plugin.pytest_runtest_call(item)
    next(hook)
    try:
        test()
    except ValueError as error:
        with pytest.raises(ValueError) as kept:
            hook.throw(error)
        assert kept.value is error
        return
    with pytest.raises(StopIteration):
        hook.send(None)


@pytest.fixture
def held(code, tmp_path, monkeypatch):
    """A plugin that has seen the test `all_of` once, and holds it from now on."""
    monkeypatch.setattr(within, "MODE", str(tmp_path))
    monkeypatch.setattr(within, "HOLDS", False)
    monkeypatch.setattr(within, "REFERENCE", tmp_path / "held")
    watched(within.Within(), lambda: all_of(code))
    ((file, test, took_s, found, shown),) = map(json.loads, next(tmp_path.glob("*.jsonl")).read_text().splitlines())
    assert (file, test) == ("link/test_x.py", f"{zlib.crc32(b'test_it[1.5]'):08x}")
    assert took_s >= 0.0
    again = {"new:once~", "new:part~", "new:Kept.method~"}
    assert found.keys() == {"new:once", "new:part", "new:Kept.method", "new:refuse!", *again}
    assert shown.keys() == again
    assert all(found[name].keys() == shown[name].keys() >= {f"1{neighbours.SAME}"} for name in again)
    values = {name: {f"{test}.{call}": x for call, x in calls.items()} for name, calls in found.items()}
    inside.save(tmp_path / "held" / "link" / "test_x.txt", values)
    monkeypatch.setattr(within, "HOLDS", True)
    return within.Within()


def all_of(code):
    code.part(3.0)
    code.once()
    code.Kept.method()
    with pytest.raises(ValueError, match="too much"):
        code.refuse(8)


def test_a_test_that_returns_what_it_did_passes_whatever_an_earlier_one_has_left_in_caches(code, held):
    code.once()
    watched(held, lambda: all_of(code))
    watched(held, lambda: all_of(code))


def test_a_function_that_returns_something_else_fails_the_test_by_name(code, held):
    code.FACTOR = 2.02
    with pytest.raises(pytest.fail.Exception) as failed:
        watched(held, lambda: all_of(code))
    lines = str(failed.value).splitlines()
    assert [line.partition(" returns ")[0] for line in lines[:-1]] == [
        f"test_it[1.5]: inside of it new:{name}"
        for name in ("Kept.method", "Kept.method~", "once", "once~", "part", "part~")
    ]
    assert lines[-1] == "Where that is meant: scripts/within tests/link/test_x.py"
    assert inside.Watch.current is None


def test_a_refusal_in_other_words_fails_the_test(code, held):
    refuse = code.refuse

    def other():
        code.part(3.0)
        with pytest.raises(ValueError, match="too much"):
            refuse(9)

    with pytest.raises(pytest.fail.Exception, match=r"inside of it new:refuse! returns something else"):
        watched(held, other)


def test_a_test_that_fails_by_itself_says_that_alone(code, held):
    code.FACTOR = 2.02
    watched(held, lambda: [all_of(code), int("no number")])
    assert inside.Watch.current is None


def test_a_function_that_is_called_less_often_and_a_test_that_is_not_held_are_left_alone(code, held):
    code.FACTOR = 2.02
    watched(held, lambda: None)
    watched(held, lambda: all_of(code), OTHER)


def test_where_others_are_asked_the_tests_that_are_held_run_alone(held, monkeypatch):
    items = [OTHER, ITEM]
    held.pytest_collection_modifyitems(items)
    assert items == [OTHER, ITEM]
    monkeypatch.setattr(within, "HOLDS", False)
    held.pytest_collection_modifyitems(items)
    assert items == [ITEM]


@pytest.mark.parametrize("scope", ["module", "function", "session"])
def test_what_a_fixture_computes_is_held_as_well_unless_it_is_of_all_files(code, tmp_path, monkeypatch, scope):
    """It is its own: what a test calls counts from its own first call, and no more than its own caches."""
    monkeypatch.setattr(within, "MODE", str(tmp_path))
    monkeypatch.setattr(within, "HOLDS", False)
    monkeypatch.setattr(within, "REFERENCE", tmp_path / "held")
    node = OTHER if scope == "function" else OTHER.getparent(None)
    fixture = SimpleNamespace(scope=scope, argname="plant"), SimpleNamespace(node=node)

    def set_up(plugin):
        hook = plugin.pytest_fixture_setup(*fixture)
        next(hook)
        code.part(3.0)
        with pytest.raises(StopIteration):
            hook.send(None)

    set_up(within.Within())
    if scope == "session":
        assert not [*tmp_path.glob("*.jsonl")]
        return
    ((_, key, _, found, _),) = map(json.loads, next(tmp_path.glob("*.jsonl")).read_text().splitlines())
    values = {name: {f"{key}.{call}": x for call, x in calls.items()} for name, calls in found.items()}
    inside.save(tmp_path / "held" / "link" / "test_x.txt", values)
    asked = within.Within()
    items = [OTHER, ITEM]
    asked.pytest_collection_modifyitems(items)
    assert items == [OTHER]
    monkeypatch.setattr(within, "HOLDS", True)
    set_up(within.Within())
    code.FACTOR = 2.02
    with pytest.raises(pytest.fail.Exception, match="@plant0: inside of it new:part returns something else"):
        set_up(within.Within())


def script():
    loader = SourceFileLoader("within_script", str(ROOT / "scripts" / "within"))
    module = module_from_spec(spec_from_loader("within_script", loader))
    loader.exec_module(module)
    return module


def test_values_unlike_each_other_are_chosen_from_the_tests_that_are_quickest():
    """Eight of a function and one more for every other line; a value that is held already is not taken again."""
    of = script()
    found = {("slow.py", "new:f", f"aaaaaaaa.{call}"): float(call) for call in range(1, 8)}
    found |= {("quick.py", "new:f", f"bbbbbbbb.{call}"): float(call) for call in range(5, 20)}
    found |= {("slow.py", "new:g", "aaaaaaaa.1"): 3.0}
    found |= {("slowest.py", "new:f", "dddddddd.1"): 99.0}
    took_s = {("slowest.py", "dddddddd"): 99.0, ("slow.py", "aaaaaaaa"): 0.05, ("quick.py", "bbbbbbbb"): 0.01}
    chosen = of.choose(found, took_s, {("other.py", "new:f", "cccccccc.1"): 5.001}, {"new:f": 3})
    assert chosen == {
        **{("quick.py", "new:f", f"bbbbbbbb.{call}"): float(call) for call in range(6, 14)},
        ("slow.py", "new:g", "aaaaaaaa.1"): 3.0,
    }


def test_what_is_written_is_read_again(tmp_path):
    of = script()
    values = {("link/test_x.py", "new:f", "bbbbbbbb.2"): 1.25, ("test_y.py", "new:f!", "aaaaaaaa.1"): -3.0}
    of.save(tmp_path, values)
    assert of.load(tmp_path) == values


@pytest.mark.endurance
def test_how_long_functions_are_is_told_by_the_names_that_they_are_held_by():
    lengths = script().lengths()
    assert {"core.kept:Kept.part", "core.folder:read_bytes.<locals>.at_once", "core.budget:total_db"} <= lengths.keys()
    assert all(lines >= 0 for lines in lengths.values())


def test_arguments_that_keep_a_function_for_ever_are_given_up_and_the_test_goes_on(code, tmp_path, monkeypatch):
    """It comes back from no signal, as compiled code does not."""
    monkeypatch.setattr(within, "MODE", str(tmp_path))
    monkeypatch.setattr(within, "HOLDS", False)
    monkeypatch.setattr(within, "REFERENCE", tmp_path / "held")
    monkeypatch.setattr(within.Taking, "varying_s", 0.2)
    watched(within.Within(), lambda: code.comes_back(3.0))
    ((_, _, _, found, _),) = map(json.loads, next(tmp_path.glob("*.jsonl")).read_text().splitlines())
    assert found.keys() == {"new:comes_back"}
    assert within.FORKED.active_children() == []
