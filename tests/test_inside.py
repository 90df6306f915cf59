"""What functions return inside of a case is held: each part of it counts, what machines disagree on does not."""

import copy
import json
import os
from collections import Counter
from dataclasses import dataclass, replace
from datetime import UTC, datetime, timedelta
from functools import partial
from importlib.util import module_from_spec, spec_from_loader
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from matplotlib.figure import Figure
from nicegui import Client, ui
from nicegui.page import page

from microrad.link import gains
from places import ROOT
from reference import inside, within


@dataclass(frozen=True)
class Record:
    power_w: float
    name: str
    samples: np.ndarray
    inner: tuple[complex, dict[str, int | None]]


RECORD = Record(2.5e-9, "beacon", np.array([3.0, -1.0, 40.0]), (1.0 + 2.0j, {"rows": 3, "gone": None}))


@pytest.mark.parametrize(
    "other",
    [
        replace(RECORD, power_w=2.53e-9),
        replace(RECORD, power_w=-2.5e-9),
        replace(RECORD, name="answer"),
        replace(RECORD, samples=np.array([-1.0, 3.0, 40.0])),
        replace(RECORD, samples=np.array([3.0, 1.0, 40.0])),
        replace(RECORD, samples=np.array([3.0, -1.0, 40.0, 0.0])),
        replace(RECORD, inner=(1.0 - 2.0j, {"rows": 3, "gone": None})),
        replace(RECORD, inner=(1.0 + 2.0j, {"rows": 4, "gone": None})),
        replace(RECORD, inner=(1.0 + 2.0j, {"rows": 3, "gone": 0})),
        replace(RECORD, inner=(1.0 + 2.0j, {"rows": 3})),
    ],
)
def test_each_part_of_a_value_moves_it_by_more_than_a_rounding(other):
    assert abs(inside.value(other) - inside.value(RECORD)) > inside.NEAR
    rounded = replace(RECORD, power_w=RECORD.power_w * (1 + 1e-9), samples=RECORD.samples * (1 - 1e-9))
    assert abs(inside.value(rounded) - inside.value(RECORD)) < inside.STEADY


@pytest.mark.parametrize(
    ("one", "other"),
    [
        (b"table", b"tables"),
        (b"ab", b"ac"),
        ({1, 2}, {1, 3}),
        (datetime(2026, 1, 1, tzinfo=UTC), datetime(2026, 1, 2, tzinfo=UTC)),
        (timedelta(hours=1), timedelta(hours=2)),
        (Path("a/rows.csv"), Path("a/row.csv")),
        (Counter("aab"), Counter("abb")),
        (np.array(["range", "margin"]), np.array(["range", "gain"])),
        (np.array(["range"]), np.array([["range"]])),
        (partial(inside.value, 1.0), partial(inside.value, 2.0)),
        (int, float),
        (xr.Dataset({"a": ("x", [1.0, 2.0])}), xr.Dataset({"a": ("x", [1.0, 2.1])})),
        (xr.Dataset({"a": ("x", [1.0, 2.0])}), xr.Dataset({"b": ("x", [1.0, 2.0])})),
        (xr.DataArray([1.0], attrs={"units": "m"}), xr.DataArray([1.0], attrs={"units": "km"})),
        (xr.DataArray([1.0], {"x": [0.0]}, "x"), xr.DataArray([1.0], {"x": [0.5]}, "x")),
        (xr.DataArray([1.0]), xr.DataArray([1.1])),
    ],
)
def test_what_libraries_return_is_a_value_as_well(one, other):
    assert abs(inside.value(one) - inside.value(other)) > inside.NEAR
    assert inside.value(one) == inside.value(copy.deepcopy(one))


def test_an_element_of_a_page_is_what_it_shows_and_holds():
    def shown(words="5 W", classes="mission-field", props="title=Power", style="width: 1em"):
        with Client(page("")) as client, client.content:
            column = ui.column()
            with column:
                ui.label(words).classes(classes).props(props).style(style)
        return inside.value([column])

    assert shown() == shown()
    values = {shown(), shown("6 W"), shown(classes=""), shown(props="title=Loss"), shown(style="width: 2em")}
    assert len(values) == 5


def test_axes_are_what_is_drawn_and_written_in_them():
    def drawn(title="Margin", y=(1.0, 2.0), scale="linear", unit="dB"):
        axes = Figure().subplots()
        axes.plot([0.0, 1.0], y)
        axes.set(title=title, yscale=scale, ylabel=unit)
        return inside.value(axes)

    values = {drawn(), drawn("Loss"), drawn(y=(1.0, 3.0)), drawn(scale="log"), drawn(unit="dBm")}
    assert len(values) == 5
    assert drawn() == drawn()


def test_a_residue_of_rounding_counts_as_nothing_and_what_is_not_finite_is_told_apart():
    assert inside.value(1e-17) == pytest.approx(inside.value(-3e-17), abs=inside.NEAR + 0.3)
    different = {inside.value(x) for x in (np.nan, np.inf, -np.inf, 0.0)}
    assert len(different) == 4


def test_folders_hashes_and_versions_are_no_part_of_a_value(tmp_path):
    one, other = (f"{folder}/leo-geo.toml: " for folder in (tmp_path, "/elsewhere/pytest-of-user/pytest-7/that0"))
    assert inside.value(one) == inside.value(other) == inside.value("/leo-geo.toml: ")
    assert inside.value(f"{ROOT}/missions") == inside.value("/missions")
    one, other = (f"microrad {version}, {digit * 64}" for version, digit in (("0.3.0.dev0", "a"), ("1.0.0", "7")))
    assert inside.value(one) == inside.value(other) != inside.value("microrad, ")


def watched(number, file):
    """What the functions of a module return when one of them is called, as a case has it."""
    loader = inside.Telling(gains.__name__, gains.__file__)
    telling = module_from_spec(spec_from_loader(gains.__name__, loader))
    loader.exec_module(telling)
    watch, cores = inside.Watch(), os.cpu_count
    watch.begin()
    try:
        telling.aperture_gain_db(number, 1.55e-6)
        if not within.MODE:  # else it tells, too
            gains.aperture_gain_db(number, 1.55e-6)
        telling.aperture_gain_db(2.0 * number, 1.55e-6)
    finally:
        watch.end(file)
        os.cpu_count = cores
    return inside.gathered(file.parent)


TOLD = """
def one(x):
    def held():
        return 3.0
    if x > 1.0:
        return held()
    x = [2.0]

class A:
    def method(self):
        return "word"

def parts():
    x = yield 1.0
    yield
"""


def test_closures_methods_parts_of_a_generator_and_what_is_changed_are_told(tmp_path):
    folder = tmp_path / "microrad"
    folder.mkdir()
    (folder / "new.py").write_text(TOLD, encoding="utf-8")
    loader = inside.Telling("microrad.new", str(folder / "new.py"))
    module = module_from_spec(spec_from_loader("microrad.new", loader))
    loader.exec_module(module)
    watch, cores = inside.Watch(), os.cpu_count
    watch.begin()
    try:
        assert (module.one(2.0), module.one(0.0), module.A().method(), [*module.parts()]) == (
            3.0,
            None,
            "word",
            [1.0, None],
        )
    finally:
        watch.end(tmp_path / "1.json")
        os.cpu_count = cores
    module.one(2.0)  # behind the end
    assert {name: [*values] for name, values in watch.values.items()} == {
        "new:one.<locals>.held": ["1"],
        "new:one": ["1", "2"],
        "new:A.method": ["1"],
        "new:parts": ["1", "2", "3"],
    }
    assert watch.values["new:parts"]["1"] == round(inside.value(1.0), 6)
    assert watch.values["new:one"]["2"] == round(inside.value([[2.0]]), 6)


def test_a_function_that_returns_something_else_is_named_and_one_that_is_gone_is_not(tmp_path):
    (tmp_path / "a").mkdir()
    was = watched(0.05, tmp_path / "a" / "1.json")
    assert was["link.gains:aperture_gain_db"] == {
        "1.1": pytest.approx(32.9, abs=0.1),
        "1.2": pytest.approx(32.96, abs=0.1),
    }
    inside.save(tmp_path / "reference.txt", was)
    held = inside.load(tmp_path / "reference.txt")
    assert inside.moved("budget", held, was) == []
    (tmp_path / "b").mkdir()
    [said] = inside.moved("budget", held, watched(0.056, tmp_path / "b" / "1.json"))
    assert (
        said.startswith("budget: inside of it link.gains:aperture_gain_db returns something else (")
        and "call 1." in said
    )
    assert inside.moved("budget", {**held, "link.gains:old_name": {"1.1": 3.0}}, was) == []


def test_only_what_all_machines_return_is_held_and_each_value_once(tmp_path):
    one = {"f": {"1.1": 3.0, "1.2": 3.0, "2.1": 5.0, "1.10": 4.0}, "g": {"1.1": 1.0}}
    other = {"f": {"1.1": 3.00001, "1.2": 3.0, "2.1": 5.1, "1.10": 4.0}, "g": {"1.1": 2.0}}
    assert inside.steady([one, other]) == {"f": {"1.1": 3.0, "1.10": 4.0}}
    assert inside.steady([one, {}]) == {}
    assert json.loads(json.dumps(inside.steady([one, one])))["g"] == {"1.1": 1.0}
