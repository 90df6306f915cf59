"""The stored notebooks: their form, that their prose has no figure of its own, and that their code runs."""

import ast
import copy
import json
import os
import re
import sys
import tempfile
from pathlib import Path

import pytest

FOLDER = Path(__file__).resolve().parents[1] / "docs" / "notebooks"
NOTEBOOKS = sorted(FOLDER.glob("*.ipynb"))
STORIES = 8
LONG = ("04", "08")
"""Those that take long. What they call has examples of its own in test_public.py, and tests in loop/ and export/."""
RUN_HERE = () if os.environ.get("MICRORAD_ENDURANCE") else [path for path in NOTEBOOKS if path.name[:2] not in LONG]
"""Those whose code is run in this process, which has all that they import; in make endurance the site executes all."""

_LIBRARIES = {"microrad", "numpy", "matplotlib"}  # what a plain install with the extra docs has
_ARTICLE = "SPIE 11852, 118523B"
_NUMBER = r"(?<![A-Za-z\d.])\d+(?:\.\d+)?(?:e[-+]?\d+)?"
_METADATA = {
    "kernelspec": {"display_name": "Python 3", "language": "python", "name": "python3"},
    "language_info": {"name": "python"},
}


def stored(notebook):
    """A notebook as it is stored, so that a change of a line is one of a line."""
    return json.dumps(notebook, indent=1, ensure_ascii=False) + "\n"


def numbers(text):
    """The numbers in a text, as numbers."""
    return {float(found) for found in re.findall(_NUMBER, text.replace(_ARTICLE, ""))}


def imported(code):
    """The libraries that a piece of code imports."""
    for node in ast.walk(ast.parse(code)):
        if isinstance(node, ast.Import):
            yield from (each.name.split(".")[0] for each in node.names)
        elif isinstance(node, ast.ImportFrom):
            yield node.module.split(".")[0]


def faults(notebook):
    """What is wrong with a notebook, in words."""
    cells = notebook["cells"]
    source = ["".join(cell["source"]) for cell in cells]
    of = {
        kind: [text for cell, text in zip(cells, source, strict=True) if cell["cell_type"] == kind]
        for kind in ("code", "markdown")
    }
    form = (notebook["nbformat"], notebook["nbformat_minor"], notebook["metadata"])
    if form != (4, 5, _METADATA):
        yield "format or kernel"
    if any(cell.get("outputs") or cell.get("execution_count") is not None or cell["metadata"] for cell in cells):
        yield "outputs, counts or metadata of cells"
    ids = [cell["id"] for cell in cells]
    if len(set(ids)) < len(ids) or not all(re.fullmatch(r"[a-z]+(-[a-z]+)*", each) for each in ids):
        yield "ids that are not words, each once"
    if not 8 <= len(cells) <= 15:
        yield "number of cells"
    if not source[0].startswith("# ") or cells[-1]["cell_type"] != "markdown":
        yield "begin or end"
    if 'print("What was found")' not in of["code"][-1]:
        yield "no findings that code prints"
    if typed := numbers("\n".join(of["markdown"])) - numbers("\n".join(of["code"])):
        yield f"figures in prose that the code does not begin with: {sorted(typed)}"
    code = "\n".join(text.rstrip(";") for text in of["code"])
    if other := set(imported(code)) - _LIBRARIES - sys.stdlib_module_names:
        yield f"libraries that are not there: {sorted(other)}"
    if re.search(r"https?://|[\"'](~|/[a-z]+/)|[A-Z]:\\", "\n".join(source)):
        yield "addresses or places of a machine"
    if any(len(line) > 120 for text in source for line in text.splitlines()):
        yield "lines of more than 120 characters"


@pytest.fixture
def notebook():
    """One of them, to be spoilt."""
    return copy.deepcopy(json.loads(NOTEBOOKS[0].read_text(encoding="utf-8")))


@pytest.mark.promise("readme-17")
def test_there_is_one_for_each_story():
    assert [int(path.name[:2]) for path in NOTEBOOKS] == list(range(1, STORIES + 1))


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_nothing_is_wrong_with_its_form(path):
    text = path.read_text(encoding="utf-8")
    assert list(faults(json.loads(text))) == []
    assert text == stored(json.loads(text))


@pytest.mark.promise("readme-17")
@pytest.mark.usefixtures("rows_here")
@pytest.mark.parametrize("path", RUN_HERE, ids=lambda path: path.stem)
def test_its_code_runs_and_says_what_was_found(path, tmp_path, monkeypatch, capsys):
    pyplot = pytest.importorskip("matplotlib.pyplot", reason="nothing is drawn without matplotlib")
    pyplot.switch_backend("Agg")
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    monkeypatch.chdir(tmp_path)
    names = {}
    for cell in json.loads(path.read_text(encoding="utf-8"))["cells"]:
        if cell["cell_type"] == "code":
            exec("".join(cell["source"]), names)
    pyplot.close("all")
    assert "What was found\n  " in capsys.readouterr().out


def _with_output(cells):
    next(cell for cell in cells if cell["cell_type"] == "code")["outputs"] = [{"output_type": "stream"}]


@pytest.mark.parametrize(
    ("spoil", "word"),
    [
        (_with_output, "outputs"),
        (lambda cells: cells[1].update(execution_count=3), "counts"),
        (lambda cells: cells[1].update(id=cells[3]["id"]), "ids"),
        (lambda cells: cells[1].update(id="8f2c"), "ids"),
        (lambda cells: cells.extend(copy.deepcopy(cells)), "number of cells"),
        (lambda cells: cells.pop(), "end"),
        (lambda cells: cells[-2].update(source=["print(1)"]), "findings"),
        (lambda cells: cells[0]["source"].append(" It went the wrong way by 9.2 µrad."), "[9.2]"),
        (lambda cells: cells[1]["source"].append("\nimport scipy.signal"), "['scipy']"),
        (lambda cells: cells[1]["source"].append('\nnp.loadtxt("/home/bode.csv")'), "places"),
        (lambda cells: cells[1]["source"].append("\n" + "#" * 121), "120"),
    ],
)
def test_a_fault_of_its_form_is_found(notebook, spoil, word):
    spoil(notebook["cells"])
    assert any(word in fault for fault in faults(notebook))


def test_another_kernel_is_found(notebook):
    notebook["metadata"]["kernelspec"]["name"] = "conda"
    assert "format or kernel" in list(faults(notebook))
