"""What a release says of itself: one version, and names that are where the changelog says."""

import re
import runpy
import subprocess
import sys
import tarfile
import tomllib
from importlib import import_module, metadata

import pytest

from microrad.core.installing import advice
from places import ROOT

CHANGELOG = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
RELEASE = runpy.run_path(str(ROOT / "scripts" / "release"))
PART = re.compile(r"(?m)^## (\S+) \((unreleased|\d{4}-\d\d-\d\d)\)$")


# --------------------------------------------------------------------------------------------------------- the version
def test_the_version_is_that_of_the_first_part_and_a_dated_part_is_a_release():
    parts = PART.findall(CHANGELOG)
    assert len(parts) == CHANGELOG.count("\n## ")
    assert RELEASE["stated"](CHANGELOG) == parts[0][0]
    for version, date in parts:
        assert re.fullmatch(r"\d+\.\d+\.\d+" + r"\.dev0" * (date == "unreleased"), version), version
    assert "unreleased" not in [date for _, date in parts[1:]]
    with pytest.raises(SystemExit, match=r"begin it with '## VERSION \(unreleased\)'"):
        RELEASE["stated"]("# Changelog\n")


def test_what_is_installed_has_that_version():
    assert metadata.version("microrad") == RELEASE["stated"](CHANGELOG), f"installed before: {advice()}"


def test_a_commit_is_tagged_with_its_version_and_no_other():
    fault = RELEASE["fault"]
    assert fault("0.2.0", ["0.2.0"]) == fault("0.3.0.dev0", []) == ""
    assert fault("0.2.0", []) == "CHANGELOG.md is of 0.2.0, and HEAD has no such tag (none): git tag 0.2.0"
    assert "no such tag (0.1.9)" in fault("0.2.0", ["0.1.9"])
    assert fault("0.3.0.dev0", ["0.2.0"]) == (
        "tag 0.2.0 stands on HEAD, whose CHANGELOG.md is of 0.3.0.dev0: date its first part"
    )


def test_the_first_part_is_dated_once():
    text = "# Changelog\n\n## 0.3.0.dev0 (unreleased)\n\n- new\n\n## 0.2.0 (2026-11-26)\n"
    done = RELEASE["dated"](text, "2027-01-31")
    assert done == text.replace("0.3.0.dev0 (unreleased)", "0.3.0 (2027-01-31)")
    with pytest.raises(SystemExit, match=r"is of 0\.3\.0 and no unreleased one: it is frozen already"):
        RELEASE["dated"](done, "2027-02-01")


def test_a_released_version_is_not_that_of_later_commits():
    said = subprocess.run(
        ["git", "-C", ROOT, "tag", "--no-contains", "HEAD"], capture_output=True, text=True, check=False
    )
    version = RELEASE["stated"](CHANGELOG)
    assert version not in said.stdout.split(), f"{version} is tagged: begin CHANGELOG.md with the next version"


# ----------------------------------------------------------------------------------------------------------- the names
MOVED = re.findall(r"(?m)^  \| `(.*)` \| `(.*)` \|$", CHANGELOG)


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


@pytest.mark.parametrize(("was", "now"), MOVED)
def test_a_name_that_moved_is_where_the_changelog_says(was, now):
    assert [name for name in now.split("`, `") if not there(name)] == []
    assert not there(f"{now.split('`, `')[0]}_of_none")


# ---------------------------------------------------------------------------------------------------------- the bounds
def test_the_lowest_versions_are_those_of_pyproject():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    found = list(RELEASE["lowest"](project))
    assert all(re.fullmatch(r"[\w-]+==[\w.]+", each) for each in found)
    assert {text.partition(">=")[0] for text in project["dependencies"]} < {each.partition("==")[0] for each in found}


def test_the_tests_of_the_bounds_are_there():
    assert all((ROOT / "tests" / each).exists() for each in RELEASE["TESTS"])
    assert all((ROOT / "tests" / each.partition("::")[0]).exists() for each in RELEASE["OF_THE_PINS"])


# --------------------------------------------------------------------------------------------------------- the workflow
def test_the_workflow_runs_the_gate_on_the_oldest_and_the_newest_python():
    text = (ROOT / ".github" / "workflows" / "ci.yml").read_text(encoding="utf-8")
    described = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    pythons = [each.rpartition(" ")[2] for each in described["classifiers"] if ":: 3." in each]
    assert f'python: ["{pythons[0]}", "{pythons[-1]}"]\n' in text and "- run: bash .ci/run\n" in text
    assert described["requires-python"] == f">={pythons[0]},<3.{int(pythons[-1][2:]) + 1}"
    used = re.findall(r"uses: (.*)", text)
    assert used and all(re.fullmatch(r"actions/[\w-]+@[0-9a-f]{40} # v[\d.]+", each) for each in used)
    assert "secrets" not in text and "contents: read\n" in text and "write" not in text


# --------------------------------------------------------------------------------------------------------- the citation
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
