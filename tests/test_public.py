"""What `import microrad` offers: each name has an example that runs, types for a strict checker, and one place."""

import inspect
import os
import pickle
import re
import subprocess
import sys
import textwrap
from functools import wraps

import numpy as np
import pytest

import microrad
from day_files import element_set
from microrad.loop import disturbance
from microrad.mirror.hysteresis import PrandtlIshlinskii
from microrad.study import study
from places import ROOT
from shipped import SHIPPED, without_day, without_fine_pointing
from small_campaign import campaign_file, without_worker

UNREAD = """
[mypy]

[mypy-{}]
follow_imports = skip
"""
"""A configuration of the type checker for which these libraries are not read: it checks what is microrad's own."""
OTHERS = (
    *("numba", "scipy", "pandas", "pyarrow", "xarray", "dask", "distributed", "tornado", "attr", "mypy", "IPython"),
    *(
        "matplotlib",
        "pydantic",
        "pydantic_core",
        "cycler",
        "rich",
        "markdown_it",
        "mdurl",
        "jinja2",
        "PIL",
        "pyparsing",
        "prompt_toolkit",
        "opentelemetry",
    ),
)
BLOCK = re.compile(r"```python\n(.*?)```", re.DOTALL)


def examples(name):
    """The examples of a public name: those of its docstring, for a class without one those of its methods."""
    thing = getattr(microrad, name)
    own = BLOCK.findall(inspect.getdoc(thing) or "")
    if inspect.isclass(thing) and not own:
        own = [e for m in vars(thing).values() if callable(m) for e in BLOCK.findall(inspect.getdoc(m) or "")]
    return [textwrap.dedent(each) for each in own]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """The files that examples name."""
    place = tmp_path_factory.mktemp("examples")
    campaign_file(place)
    short = without_fine_pointing(without_day(SHIPPED.read_text(encoding="utf-8")))
    (place / "leo-geo.toml").write_text(short, encoding="utf-8")
    mirrors = ROOT / "tests" / "corpus" / "0.1.0" / "mirrors"
    (place / "loop-mirror.toml").write_bytes((mirrors / "identified.toml").read_bytes())
    (place / "satellites.tle").write_text(
        element_set() + element_set(revolutions=1.0027, inclination=0.1, name="RELAY", number="70002"), encoding="utf-8"
    )
    time_s = np.arange(4000) * 5e-4
    drive_v = 30.0 + 8.0 * np.sin(2 * np.pi * 3 * time_s)
    noise = np.random.default_rng(1)
    angle = 1e6 * PrandtlIshlinskii((0.0, 1.0, 2.0), (40e-6, 6e-6, 4e-6)).response(drive_v - 30.0, 5e-4)
    rows = np.column_stack([time_s, drive_v, angle + 0.2 * noise.standard_normal(4000)])
    np.savetxt(place / "loop.csv", rows, delimiter=",", header="time,drive,angle", comments="", fmt="%.9g")
    freq_hz = np.geomspace(10.0, 3000.0, 120)
    s = 2j * np.pi * freq_hz
    response = 40e-6 / (1 + 2 * 0.02 * s / 6000 + (s / 6000) ** 2)
    response += 2e-7 * (noise.standard_normal(120) + 1j * noise.standard_normal(120))
    table = np.column_stack([freq_hz, np.abs(response), np.degrees(np.angle(response))])
    np.savetxt(place / "bode.csv", table, delimiter=",", header="frequency,gain,phase", comments="", fmt="%.9g")
    return place


def once(function):
    """A function that is called once with the same arguments."""
    found = {}

    @wraps(function)
    def known(*args, **more):
        given = pickle.dumps((args, more))
        if given not in found:
            found[given] = function(*args, **more)
        return found[given]

    return known


FOUND_ONCE = [
    (disturbance, "fit_spectrum", once(disturbance.fit_spectrum)),
    (study, "run_study", once(study.run_study)),
]
"""What takes long in several examples."""


def forget():
    """Let names be looked up anew."""
    for known in microrad._PUBLIC:
        vars(microrad).pop(known, None)


@pytest.fixture
def found_once(monkeypatch):
    """What several examples call is called once; names are looked up anew here, and by whoever comes behind."""
    for place, taken, found in FOUND_ONCE:
        monkeypatch.setattr(place, taken, found)
    forget()
    yield
    forget()


@pytest.mark.promise("readme-1", "readme-17")
@pytest.mark.promise("index-1")
@pytest.mark.usefixtures("found_once")
@pytest.mark.parametrize("name", microrad._PUBLIC)
def test_every_public_name_has_an_example_that_runs(name, folder, monkeypatch, capsys):
    monkeypatch.chdir(folder)
    without_worker(monkeypatch)
    given = examples(name)
    assert given, f"{name} has no example"
    for text in given:
        assert f"microrad.{name}" in text or f"import {name}" in text or f", {name}" in text
        exec(compile(text, f"example of {name}", "exec"), {})
    assert name in ("write_report", "run_campaign") or name.startswith("plot_") or capsys.readouterr().out


@pytest.mark.promise("index-3")
@pytest.mark.usefixtures("found_once")
def test_the_example_of_the_front_page_runs(folder, monkeypatch, capsys):
    monkeypatch.chdir(folder)
    without_worker(monkeypatch)
    (text,) = BLOCK.findall((ROOT / "docs" / "index.md").read_text(encoding="utf-8"))
    scope = {}
    exec(text, scope)
    study = scope["study"]
    assert study.met is False  # the folder's mission has no loop that keeps to what is required
    assert capsys.readouterr().out == f"False {study.achieved.margin_db}\n"
    (shown,) = [r for r in study.requirements if r.name == "communication margin"]
    assert shown.actual == study.achieved.margin_db


@pytest.mark.endurance
def test_examples_satisfy_a_strict_type_checker_run_from_outside(tmp_path):
    texts = [text for name in microrad._PUBLIC for text in examples(name)]
    body = "".join(f"def example_{i}() -> None:\n{textwrap.indent(text, '    ')}\n\n" for i, text in enumerate(texts))
    wrong = "import microrad\nmicrorad.parse_quantity(5)\n"  # the one error, or nothing would have been checked
    (tmp_path / "examples.py").write_text(body + wrong, encoding="utf-8")
    (tmp_path / "mypy.ini").write_text(UNREAD.format(",".join(f"{name}.*" for name in OTHERS)), encoding="utf-8")
    command = [sys.executable, "-m", "mypy", "--strict", "--cache-dir", os.devnull, "examples.py"]
    found = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert found.returncode == 1 and "Found 1 error " in found.stdout, found.stdout + found.stderr
    assert 'Missing positional argument "unit"' in found.stdout


README = (ROOT / "README.md").read_text(encoding="utf-8")


@pytest.mark.promise("readme-16", "readme-31")
def test_the_code_of_the_readme_runs(folder, monkeypatch):
    (folder / "missions").mkdir(exist_ok=True)
    (folder / "missions" / "leo-geo.toml").write_bytes((folder / "leo-geo.toml").read_bytes())
    monkeypatch.chdir(folder)
    ran = []
    monkeypatch.setattr(microrad, "run_study", lambda file: ran.append(file) or "study", raising=False)
    (code,) = BLOCK.findall(README)
    known = {}
    exec(code, known)
    assert len(ran) == 1 and known["study"] == "study"
    poles_hz = [abs(pole) / (2.0 * np.pi) for pole in np.linalg.eigvals(known["fit"].system.A)]
    assert min(abs(pole - 6000 / (2 * np.pi)) for pole in poles_hz) < 10.0
    loop = known["plays"].response(8.0 * np.sin(np.linspace(0.0, 20.0, 500)), 5e-4)
    assert np.ptp(loop[200:]) == pytest.approx(16.0 * 46e-6, rel=0.1)


@pytest.mark.promise("readme-16", "readme-22")
def test_the_readme_lists_each_public_name():
    section = README.partition("## In Python")[2].partition("\n## ")[0]
    rows = re.findall(r"(?m)^\| .*? \| (`.*`) \|$", section)
    listed = {name for row in rows for name in re.findall("`(.*?)`", row)}
    assert microrad._PUBLIC.keys() - listed == {"parse_quantity", "MicroradError"}
    assert listed <= microrad._PUBLIC.keys()
    plots = [name for name in microrad._PUBLIC if name.startswith("plot_")]
    assert "Fewer than thirty names and eight plots" in section
    assert (len(microrad._PUBLIC) - len(plots) < 30, len(plots)) == (True, 8)


@pytest.mark.parametrize("name", microrad._MOVED)
def test_a_name_of_0_1_0_says_where_it_lives_now(name):
    with pytest.warns(DeprecationWarning, match=rf"microrad\.{name} goes in 0\.3\.0: write from microrad\.") as said:
        old = getattr(microrad, name)
    scope = {}
    exec(str(said[0].message).partition("write ")[2], scope)
    assert scope[str(said[0].message).rpartition(" ")[2]] is old
    assert name not in dir(microrad)


def test_all_public_names_and_the_version_are_what_a_star_brings():
    scope = {}
    exec("from microrad import *", scope)
    assert scope.keys() - {"__builtins__"} == {*microrad._PUBLIC, "__version__"} == set(microrad.__all__)


@pytest.mark.promise("decisions-1", "readme-16")
def test_there_are_few_names_and_they_load_nothing():
    code = "import sys, microrad; print(len(sys.modules), 'numpy' in sys.modules)"
    loaded = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.split()
    assert loaded[1] == "False"
    plots = [name for name in microrad._PUBLIC if name.startswith("plot_")]
    assert len(microrad._PUBLIC) - len(plots) <= 30 and len(plots) == 8
    assert not microrad._PUBLIC.keys() & microrad._MOVED.keys()
