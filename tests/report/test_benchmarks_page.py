"""What benchmarks found: kept in one file a release, and said by the page and its figure as it stands there."""

import ast
import json
import re
import sys

import pytest

import benchmarks_page as benchmarks
from microrad.report.plotting.sheet import Line
from microrad.report.plotting.svg import svg_of
from places import ROOT, benchmark

recorded = benchmark("recorded")


@pytest.fixture
def kept(tmp_path, monkeypatch):
    """What is kept so far, in a folder of its own."""
    monkeypatch.setattr(recorded, "FOLDER", tmp_path / "results")
    monkeypatch.setattr(recorded.microrad, "__version__", "0.3.0.dev0", raising=False)
    monkeypatch.setattr(sys, "argv", ["benchmarks/loop.py"])
    monkeypatch.setenv("MICRORAD_RECORD", "yes")
    path = tmp_path / "results" / "0.3.0.json"
    return lambda: json.loads(path.read_text(encoding="utf-8")) if path.exists() else None


def row(what, value, unit="", at_most=None, at_least=None):
    return {"benchmark": "loop", "what": what, "value": value, "unit": unit, "at_most": at_most, "at_least": at_least}


# --------------------------------------------------------------------------------------------------------- the recorder
@pytest.mark.promise("benchmarks-1", "releasing-2")
def test_a_figure_is_kept_where_it_is_asked_for_and_takes_the_place_of_its_last_one(kept, monkeypatch):
    monkeypatch.delenv("MICRORAD_RECORD")
    recorded.record("a step", 1.0)
    assert kept() is None
    monkeypatch.setenv("MICRORAD_RECORD", "yes")
    recorded.record("a step", 1.23456)
    recorded.record("a fit", 50.0, "s", at_most=60.0)
    recorded.record("a step", 1.5)
    found = kept()
    assert (found["version"], found["machine"]["cores"] >= 1, "numpy" in found["versions"]) == ("0.3.0", True, True)
    dates = {each.pop("date") for each in found["rows"]}
    assert len(dates) == 1
    assert found["rows"] == [row("a fit", 50.0, "s", at_most=60.0), row("a step", 1.5)]


@pytest.mark.promise("benchmarks-1")
def test_figures_of_two_machines_are_not_mixed(kept, monkeypatch):
    recorded.record("a step", 1.23456)
    assert kept()["rows"][0]["value"] == 1.23
    monkeypatch.setattr(recorded.machine, "machine", lambda: {"architecture": "another"})
    with pytest.raises(SystemExit, match="is of another machine or of other libraries: delete it, and record all anew"):
        recorded.record("a step", 2.0)
    assert kept()["rows"][0]["value"] == 1.23


LISTED = {
    "loop.py": "C twin|solve_ivp|import control",
    "ensemble.py": "C twin",
    "hysteresis_fit.py": "solve_ivp",
    "frequency_response_fit.py": "skrf",
    "recording.py": "ten million samples",
    "contacts.py": "constellation sees four slots|1000 x 4",
    "link_conventions.py": "Where link budgets differ",
}
"""What `make benchmark` prints by README.md: words of each benchmark on what it compares with or measures."""
KEPT = {
    "loop": "over C twin, a plant step",
    "ensemble": "64 runs side by side: kernel over scalar C twin",
    "frequency_response_fit": "time over scikit-rf",
    "contacts": "1000 satellites with 4 slots",
}
"""Of those that keep figures, what the last release has of them."""


@pytest.mark.promise("benchmarks-1", "readme-20")
@pytest.mark.promise("decisions-5", "identify-55")
def test_make_benchmark_runs_each_benchmark_and_what_the_readme_lists():
    text = (ROOT / "Makefile").read_text(encoding="utf-8")
    ran = set(re.findall(r"benchmarks/([\w.]+)", text.partition("\nbenchmark:")[2].partition("\n\n")[0]))
    assert {path.name for path in (ROOT / "benchmarks").glob("*.py")} >= ran >= LISTED.keys()
    for name, words in LISTED.items():
        source = (ROOT / "benchmarks" / name).read_text(encoding="utf-8")
        assert [word for word in words.split("|") if word not in source] == [], name
    rows = benchmarks.releases()[-1]["rows"]
    for name, words in KEPT.items():
        assert any(words in each["what"] and each["value"] > 0.0 for each in rows if each["benchmark"] == name), name
    assert {f"{each['benchmark']}.py" for release in benchmarks.releases() for each in release["rows"]} <= ran


@pytest.mark.promise("decisions-5", "readme-20")
def test_the_benchmark_of_conventions_prints_where_published_budgets_differ_term_by_term(capsys):
    benchmark("link_conventions").compare()
    said = capsys.readouterr().out
    assert "Loss: exp(-G error^2)" in said and "MathWorks" in said and "Liang" in said
    rows = re.findall(r"(?m)^(\w.*?) {2,}(-?[\d.]+) +(-?[\d.]+) +(-?[\d.]+)\b", said)
    assert len(rows) > 20
    for term, own, peer, difference in rows:
        assert float(difference) == pytest.approx(float(own) - float(peer), abs=2e-4), term


@pytest.mark.promise("benchmarks-1")
def test_each_benchmark_says_first_what_it_measures():
    for name in re.findall(r"benchmarks/([\w.]+)", (ROOT / "Makefile").read_text(encoding="utf-8")):
        said = ast.get_docstring(ast.parse((ROOT / "benchmarks" / name).read_text(encoding="utf-8")))
        assert said and len(said.splitlines()[0].split()) > 5, name


# ------------------------------------------------------------------------------------------------------------- the page
@pytest.mark.promise("benchmarks-1")
def test_page_and_figure_are_those_of_the_kept_figures():
    found = benchmarks.releases()
    text = benchmarks.PAGE.read_text(encoding="utf-8")
    assert text == benchmarks.page(found), "run scripts/benchmarks_page.py"
    assert benchmarks.FIGURE.read_text(encoding="utf-8") == svg_of(benchmarks.figure(found))
    assert all(f"| {each['what']} | " in text for each in found[-1]["rows"])


@pytest.mark.promise("benchmarks-1")
def test_a_bar_is_met_from_its_own_side():
    def release(version, *rows):
        return {
            "version": version,
            "rows": [{**each, "date": "2026-11-26"} for each in rows],
            "machine": {"cores": 2, "processor": "znver3", "architecture": "x86_64"},
            "versions": dict.fromkeys(("python", "numpy", "scipy", "numba"), "1"),
        }

    rows = [
        row("quick", 0.5, "s", at_most=1.0),
        row("slow", 2.0, "s", at_most=1.0),
        row("many", 200.0, "", at_least=50.0),
        row("few", 1600.0, "rows/s", at_least=3200.0),
        row("over twin", 0.25),
    ]
    assert [benchmarks.share(each) for each in rows] == [0.5, 2.0, 0.25, 2.0, None]
    assert [benchmarks.ratio(each) for each in rows] == [None, None, None, None, 0.25]
    releases = [release("0.2.0", row("slow", 3.0, "s", at_most=1.0)), release("0.10.0", *rows)]
    text = benchmarks.page(releases)
    assert "## 0.10.0\n\nRecorded on 2026-11-26 on 2 cores of kind znver3 (x86_64), with python 1, " in text
    assert "| quick | 0.5 s | at most 1 s | yes |\n| slow | 2 s | at most 1 s | no |\n" in text
    assert "| few | 1 600 rows/s | at least 3 200 rows/s | no |\n| over twin | 0.25 | – | – |\n" in text
    shares, ratios = benchmarks.figure(releases).panels
    earlier, last = shares.all_of(Line)
    assert (earlier.label, last.label) == ("0.2.0", "0.10.0")
    assert last.x.tolist() == [0.5, 2.0, 0.25, 2.0]
    assert earlier.x[1] == 3.0 and not (earlier.x[[0, 2, 3]] >= 0).any()
    assert ratios.all_of(Line)[-1].x.tolist() == [0.25]
