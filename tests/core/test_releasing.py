"""What a release says of itself: one version, and names that are where the changelog says."""

import re
import runpy
import subprocess
import sys
import tarfile
import tomllib
from importlib import import_module, metadata

import pytest

import microrad
from microrad.core.installing import advice
from places import ROOT

CHANGELOG = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
RELEASE = runpy.run_path(str(ROOT / "scripts" / "release"))
PART = re.compile(r"(?m)^## (\S+) \((unreleased|\d{4}-\d\d-\d\d)\)$")


# --------------------------------------------------------------------------------------------------------- the version
@pytest.mark.promise("releasing-1", "releasing-2")
def test_the_version_is_that_of_the_first_part_and_a_dated_part_is_a_release():
    parts = PART.findall(CHANGELOG)
    assert len(parts) == CHANGELOG.count("\n## ")
    assert RELEASE["stated"](CHANGELOG) == parts[0][0]
    for version, date in parts:
        assert re.fullmatch(r"\d+\.\d+\.\d+" + r"\.dev0" * (date == "unreleased"), version), version
    assert "unreleased" not in [date for _, date in parts[1:]]
    with pytest.raises(SystemExit, match=r"begin it with '## VERSION \(unreleased\)'"):
        RELEASE["stated"]("# Changelog\n")


@pytest.mark.promise("releasing-1")
def test_what_is_installed_has_that_version():
    assert metadata.version("microrad") == RELEASE["stated"](CHANGELOG), f"installed before: {advice()}"


@pytest.mark.promise("releasing-1")
def test_the_version_stands_nowhere_else():
    described = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    assert "version" not in described["project"] and described["project"]["dynamic"] == ["version"]
    assert described["tool"]["hatch"]["version"]["path"] == "CHANGELOG.md"
    version = RELEASE["stated"](CHANGELOG)
    files = [path for path in (ROOT / "src").rglob("*.py*") if path.suffix in (".py", ".pyi")]
    assert [path for path in files if f'"{version}"' in path.read_text(encoding="utf-8")] == []


@pytest.mark.promise("releasing-1", "releasing-2")
def test_a_commit_is_tagged_with_its_version_and_no_other():
    fault = RELEASE["fault"]
    assert fault("0.2.0", ["0.2.0"]) == fault("0.3.0.dev0", []) == ""
    assert fault("0.2.0", []) == "CHANGELOG.md is of 0.2.0, and HEAD has no such tag (none): git tag 0.2.0"
    assert "no such tag (0.1.9)" in fault("0.2.0", ["0.1.9"])
    assert fault("0.3.0.dev0", ["0.2.0"]) == (
        "tag 0.2.0 stands on HEAD, whose CHANGELOG.md is of 0.3.0.dev0: date its first part"
    )


@pytest.mark.promise("releasing-2")
def test_the_first_part_is_dated_once():
    text = "# Changelog\n\n## 0.3.0.dev0 (unreleased)\n\n- new\n\n## 0.2.0 (2026-11-26)\n"
    done = RELEASE["dated"](text, "2027-01-31")
    assert done == text.replace("0.3.0.dev0 (unreleased)", "0.3.0 (2027-01-31)")
    with pytest.raises(SystemExit, match=r"is of 0\.3\.0 and no unreleased one: it is frozen already"):
        RELEASE["dated"](done, "2027-02-01")


@pytest.mark.promise("releasing-2")
def test_a_released_version_is_not_that_of_later_commits():
    said = subprocess.run(
        ["git", "-C", ROOT, "tag", "--no-contains", "HEAD"], capture_output=True, text=True, check=False
    )
    version = RELEASE["stated"](CHANGELOG)
    assert version not in said.stdout.split(), f"{version} is tagged: begin CHANGELOG.md with the next version"


# ----------------------------------------------------------------------------------------------------------- the names
MOVED = re.findall(r"(?m)^  \| `(.*)` \| `((?!microrad\.).*)` \|$", CHANGELOG)
AT_THE_TOP = re.findall(r"(?m)^  \| (`.*`\)?) \| `microrad\.(.*)` \|$", CHANGELOG)


def there(name):
    """Whether a module, or a name in one, is there below microrad."""
    module, _, attribute = f"microrad.{name}".rpartition(".")
    try:
        import_module(f"{module}.{attribute}")
    except ModuleNotFoundError:
        try:
            return hasattr(import_module(module), attribute)
        except ModuleNotFoundError:
            return False
    return True


def test_every_name_that_left_the_top_stands_in_the_changelog_with_its_module():
    said = {(name, module) for names, module in AT_THE_TOP for name in re.findall(r"(?<!\()`(\w+)`", names)}
    assert said == {(name, place.rpartition(".")[0]) for name, place in microrad._MOVED.items()}


@pytest.mark.parametrize(("was", "now"), MOVED)
def test_a_name_that_moved_is_where_the_changelog_says(was, now):
    assert [name for name in now.split("`, `") if not there(name)] == []
    assert not there(f"{now.split('`, `')[0]}_of_none")


# ---------------------------------------------------------------------------------------------------------- the bounds
@pytest.mark.promise("releasing-2")
def test_the_lowest_versions_are_those_of_pyproject():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    found = list(RELEASE["lowest"](project))
    assert all(re.fullmatch(r"[\w-]+==[\w.]+", each) for each in found)
    assert {text.partition(">=")[0] for text in project["dependencies"]} < {each.partition("==")[0] for each in found}


@pytest.mark.promise("releasing-2")
def test_the_tests_of_the_bounds_are_there():
    assert all((ROOT / "tests" / each).exists() for each in RELEASE["TESTS"])
    assert all((ROOT / "tests" / each.partition("::")[0]).exists() for each in RELEASE["OF_THE_PINS"])


@pytest.mark.promise("releasing-6")
def test_no_lower_bound_is_below_what_is_known_not_to_do():
    described = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    bounds = dict(text.split(">=") for text in described["dependencies"] if ">=" in text)
    page = " ".join((ROOT / "docs" / "releasing.md").read_text(encoding="utf-8").split())
    said = {"skyfield": re.search(r"They pass with skyfield ([\d.]+), which is the lower bound now", page)[1]}
    said |= {name: re.search(rf"\b{name} before ([\d.]+\d)", page)[1] for name in ("typer", "markupsafe", "h5py")}
    assert {name: bounds[name] for name in said} == said
    refused = re.search(r"\bnumba ([\d.]+) \(refuses", page)[1]
    assert [int(part) for part in bounds["numba"].split(".")] > [int(part) for part in refused.split(".")]


@pytest.mark.promise("releasing-10")
def test_the_newest_versions_are_tried_with_what_a_test_asks_of_hatchling(monkeypatch):
    asked = []

    def environment(python, folder, *wanted):
        asked.extend(map(str, wanted))
        return folder, {}

    tested = RELEASE["tested"]
    monkeypatch.setitem(tested.__globals__, "_environment", environment)
    monkeypatch.setitem(tested.__globals__, "_run", lambda *words, **more: None)
    tested("python")
    assert [each.partition("==")[0] for each in asked].count("hatchling") == 1


@pytest.mark.promise("releasing-4")
def test_what_is_tried_of_an_archive_is_what_the_page_says():
    page = " ".join((ROOT / "docs" / "releasing.md").read_text(encoding="utf-8").split())
    said = re.search(r"An archive alone in an empty environment, .*?: (.*?) \(`scripts/release check`\)", page)[1]
    programs = [words for words in RELEASE["TRIED"] if words[0] == "microrad"]
    assert [words[1] for words in programs] == ["--version", "doctor", "init", "run"]
    assert said.startswith(
        "`microrad --version`, `doctor`, `init` and `run` of the shipped mission, and each public name"
    )
    assert [words[0] for words in RELEASE["TRIED"] if words not in programs] == ["python"]
    assert "__init__.pyi" in RELEASE["PUBLIC"] and "getattr(microrad, name)" in RELEASE["PUBLIC"]


@pytest.mark.promise("releasing-2")
def test_a_freeze_dates_the_changelog_and_keeps_reference_and_corpus(tmp_path, monkeypatch):
    (tmp_path / "CHANGELOG.md").write_text("# Changelog\n\n## 0.3.0.dev0 (unreleased)\n", encoding="utf-8")
    (tmp_path / "reference" / "0.2.0").mkdir(parents=True)
    (tmp_path / "reference" / "case.json").write_text("{}", encoding="utf-8")
    (tmp_path / "pyproject.toml").write_bytes((ROOT / "pyproject.toml").read_bytes())
    written, freeze = [], RELEASE["freeze"]
    monkeypatch.setitem(freeze.__globals__, "ROOT", tmp_path)
    monkeypatch.setitem(freeze.__globals__, "corpus", written.append)
    freeze()
    assert re.fullmatch(r"# Changelog\n\n## 0\.3\.0 \(\d{4}-\d\d-\d\d\)\n", (tmp_path / "CHANGELOG.md").read_text())
    kept = sorted(path.relative_to(tmp_path).as_posix() for path in (tmp_path / "reference").rglob("*.json"))
    assert kept == ["reference/0.3.0/case.json", "reference/case.json"]
    assert not (tmp_path / "reference" / "0.2.0").exists()
    assert written == [tmp_path / "tests" / "corpus" / "0.3.0"]


# --------------------------------------------------------------------------------------------------------- the workflow
@pytest.mark.promise("releasing-3", "releasing-5")
def test_the_workflow_runs_the_gate_on_the_oldest_and_the_newest_python():
    text = (ROOT / ".github" / "workflows" / "ci.yml").read_text(encoding="utf-8")
    described = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    pythons = [each.rpartition(" ")[2] for each in described["classifiers"] if ":: 3." in each]
    assert f'python: ["{pythons[0]}", "{pythons[-1]}"]\n' in text and "- run: bash .ci/run\n" in text
    assert described["requires-python"] == f">={pythons[0]},<3.{int(pythons[-1][2:]) + 1}"
    used = re.findall(r"uses: (.*)", text)
    archives = text.partition("  archives:\n")[2]
    assert archives.startswith("    if: github.ref_type == 'tag'\n    needs: gate\n")
    steps = [each for each in re.findall(r"- run: (.*)", archives) if "release" in each]
    assert steps == [
        ".venv/bin/python scripts/release build",
        f".venv/bin/python scripts/release check python{pythons[0]} python{pythons[-1]}",
    ]
    assert "twine" not in text and "pypi" not in text.lower()
    assert used and all(re.fullmatch(r"actions/[\w-]+@[0-9a-f]{40} # v[\d.]+", each) for each in used)
    assert "secrets" not in text and "contents: read\n" in text and "write" not in text


# --------------------------------------------------------------------------------------------------------- the citation
@pytest.mark.promise("releasing-1")
def test_the_citation_names_what_the_project_is_and_no_version_that_would_age():
    text = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    described = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    fields = dict(re.findall(r"(?m)^([\w-]+): (.+)$", text))
    assert (fields["cff-version"], fields["title"], fields["license"]) == ("1.2.0", "microrad", described["license"])
    assert re.findall(r"(?m)^  - ([\w ]+)$", text) == described["keywords"]
    assert fields.keys() & {"version", "date-released"} == set()
    assert " ".join(re.search(r"(?ms)^abstract: >-\n(.*?)\n(?=\S)", text)[1].split()).startswith(
        described["description"].partition(":")[0]
    )


# --------------------------------------------------------------------------------------------------------- the archives
@pytest.mark.promise("releasing-1")
@pytest.mark.endurance
def test_every_file_of_the_package_is_in_the_source_archive(tmp_path):
    command = [sys.executable, "-m", "hatchling", "build", "--target", "sdist", "--directory", tmp_path]
    subprocess.run(command, cwd=ROOT, check=True, capture_output=True)
    (archive,) = tmp_path.glob("microrad-*.tar.gz")
    with tarfile.open(archive) as opened:
        there = {name.partition("/")[2] for name in opened.getnames()}
    files = (path for path in (ROOT / "src").rglob("*") if path.is_file() and "__pycache__" not in path.parts)
    own = {path.relative_to(ROOT).as_posix() for path in files}
    assert "src/microrad/lab/plans/paper-experiment.toml" in own
    assert own - there == set()
    assert {"plans/paper-experiment.toml", "missions/leo-geo.toml", "CITATION.cff", "CHANGELOG.md"} <= there
