"""Files of figures: the columns of their data, and pictures that an earlier run has kept."""

import csv
import json
import pickle
import re
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from microrad import report
from microrad.core.kept import Kept
from microrad.report.plotting import layout, svg
from microrad.report.plotting.sheet import Line
from shipped import whole_drawn

COLUMNS = json.loads(Path(__file__).with_name("figure_columns.json").read_text(encoding="utf-8"))
"""Headings of the data of each figure of the shipped mission, which spreadsheets of users are made for."""

SI = {"rad", "s", "bit/s", "bit", "dB", "Hz", "m", "V", "rad/s", "rad/V", "V/rad", "V/(rad s)", "rad^2/Hz", "SI", "0"}
"""Units in the headings; an input of a tornado has its unit in a column of its own, and a switch is (1) or (0)."""


@pytest.mark.promise("report-2")
def test_the_data_of_each_figure_have_their_columns():
    found = {figure.name: [*figure.columns] for figure in whole_drawn().every}
    assert {name: found.get(name) for name in COLUMNS} == COLUMNS
    assert found.keys() == COLUMNS.keys()


@pytest.mark.promise("report-2")
def test_columns_are_in_si_and_a_map_in_degrees():
    units = {
        (name, re.search(r"\(([^()]*(?:\([^()]*\))?)\)$", each)) for name, every in COLUMNS.items() for each in every
    }
    found = {(name, unit[1]) for name, unit in units if unit}
    assert {unit for name, unit in found if name != "world-map"} <= SI
    assert {unit for name, unit in found if name == "world-map"} == {"deg"}


def test_pictures_are_kept_as_they_were_drawn(tmp_path, monkeypatch):
    figures = tuple(f for f in whole_drawn().every if f.name in ("latency", "tornado", "claims-scan"))
    assert len(figures) == 3
    given, parts = pickle.dumps(figures), Kept(tmp_path / "parts")
    drawn = parts.part(report.pictures, given)
    assert drawn == tuple((f.svg, f.plot, report.columns_csv(f.columns)) for f in figures)
    monkeypatch.setattr(report, "columns_csv", lambda columns: pytest.fail("written again"))
    assert parts.part(report.pictures, given) == drawn


@pytest.mark.promise("report-2")
def test_numbers_end_early_and_stay_empty_where_there_are_none():
    columns = {"a (m)": [1.0, float("nan"), float("inf")], "b": [0.5]}
    made = {name: np.array(values) for name, values in columns.items()}
    assert report.columns_csv(made) == b"a (m),b\r\n1,0.5\r\n,\r\ninf,\r\n"
    third = np.array([1.0 / 3.0])
    assert report.columns_csv({"a": third, "b": 2e-9 * third}) == b"a,b\r\n0.333333333,6.66666667e-10\r\n"
    assert report.columns_csv({"a": third, "b": ("c",)}) == b"a,b\r\n0.333333333,c\r\n"
    assert report.columns_csv({"a": np.array([1.0, float("nan"), 2.0])}) == b'a\r\n1\r\n""\r\n2\r\n'
    assert report.columns_csv({}) == b"\r\n"
    named = {"input": ("a,b", "c"), **made}
    assert [*csv.reader(report.columns_csv(named).decode().splitlines())] == [
        ["input", "a (m)", "b"],
        ["a,b", "1", "0.5"],
        ["c", "", ""],
        ["", "inf", ""],
    ]


def test_a_sheet_grows_by_what_its_panels_and_their_margins_lack():
    panels = [
        SimpleNamespace(panel=SimpleNamespace(column=0, columns=1, row=row, equal=False), inner=None, colours=None)
        for row in (0, 1)
    ]
    sheet = SimpleNamespace(widths=(1.0,), heights=(1.0, 1.0))
    least = layout._LEAST
    grown = layout._share(sheet, panels, [(10.0, 20.0, 5.0, 30.0)] * 2, (0.0, 0.0, 400.0, 120.0))
    assert grown == 2.0 * least - (120.0 - 2.0 * (20.0 + 30.0))
    assert panels[-1].inner[3] + 30.0 == 120.0 + grown


def test_the_legend_shows_a_line_as_it_is_drawn():
    (dotted,) = svg._swatch(Line(np.zeros(2), np.zeros(2), dash=":"), 0.0, 0.0)
    (solid,) = svg._swatch(Line(np.zeros(2), np.zeros(2)), 0.0, 0.0)
    assert "stroke-dasharray" in dotted and "stroke-dasharray" not in solid
