"""What is installed and what is said of it: from the project's folder, in pinned versions, each file by its hash."""

import ast
import re
import subprocess
import sys
import tomllib
from importlib import metadata

import pytest
from packaging.utils import canonicalize_name

import licences
from microrad.cli import installation
from microrad.core import integrity
from microrad.core.installing import advice
from places import ROOT

PIN = re.compile(r"(?m)^(\S+)==([^\s;]+)")


def pins(name):
    """Version by name, of a file of pins."""
    found = PIN.findall((ROOT / name).read_text(encoding="utf-8"))
    assert len(dict(found)) == len(found)
    return {canonicalize_name(each): version for each, version in found}


# ------------------------------------------------------------------------------------------------------ what is advised
def test_nothing_advises_to_install_by_a_name_that_no_registry_has():
    texts = [ROOT / name for name in ("README.md", "CONTRIBUTING.md", "Makefile")]
    for folder, kind in (("src", "*.py"), ("docs", "*.md"), ("scripts", "*"), ("benchmarks", "*.py"), (".ci", "*")):
        texts += [path for path in (ROOT / folder).rglob(kind) if path.is_file() and path.suffix != ".pyc"]
    by_name = re.compile(
        r"pip3? +(?:install|download)[^\n`;]*?[\s\"']microrad(?=[\s\"'`,.;:)\[]|$)|microrad\[\w", re.MULTILINE
    )
    assert by_name.search("pip install microrad") and by_name.search("pip install --upgrade 'microrad[lab]'")
    assert not by_name.search("pip install '.[lab]'") and not by_name.search("pip install .; microrad run a.toml")
    assert [str(path) for path in texts if by_name.search(path.read_text(encoding="utf-8"))] == []


@pytest.mark.promise("readme-2")
@pytest.mark.promise("pointing-44")
@pytest.mark.promise("campaigns-63")
def test_the_advice_is_a_command_for_the_projects_folder_with_an_extra_that_there_is():
    assert advice() == "in the project's folder: pip install --constraint constraints.txt ."
    assert advice("lab") == "in the project's folder: pip install --constraint constraints.txt '.[lab]'"
    extras = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["optional-dependencies"]
    said = {
        extra
        for path in (ROOT / "src").rglob("*.py")
        for extra in re.findall(r"""\badvice\(["'](\w+)""", path.read_text(encoding="utf-8"))
    }
    assert {"lab", "xlsx", "cluster", "parquet", "control", "plot", "studio"} == said <= set(extras)


# ------------------------------------------------------------------------------------------------------------- the pins
def test_the_build_backend_is_pinned():
    built = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["build-system"]["requires"]
    assert dict(PIN.findall("\n".join(built))).items() <= pins("constraints.txt").items()
    assert len(built) == 1 and "==" in built[0]


@pytest.mark.promise("releasing-2")
def test_the_hashed_versions_are_the_pinned_ones():
    lab, test, pinned = (pins(name) for name in ("hashes/lab.txt", "hashes/test.txt", "constraints.txt"))
    assert not lab.keys() & test.keys()
    assert (lab | test).items() <= pinned.items()
    assert pinned.keys() - lab.keys() - test.keys() == {"ogs-linkbudget-live", "netcdf4", "cftime"}, "of a benchmark"
    assert {"hatchling", "editables", "numpy", "nptdms"} <= lab.keys()
    assert {"pytest", "nicegui"} <= test.keys()


@pytest.mark.promise("readme-3", "releasing-5")
def test_every_hashed_version_has_hashes_and_no_address():
    for name, head in (("lab", ""), ("test", "--requirement lab.txt\n")):
        text = (ROOT / "hashes" / f"{name}.txt").read_text(encoding="utf-8")
        block = r"[\w.-]+==[\w.]+(?: ; python_version == '3\.\d+'(?: or python_version == '3\.\d+')*)?"
        assert re.fullmatch(rf"{head}(?:{block}(?: \\\n    --hash=sha256:[0-9a-f]{{64}})+\n)+", text), name


@pytest.mark.parametrize(("extra", "file"), [("lab", "lab"), ("test", "test")])
def test_what_the_project_asks_for_is_hashed(extra, file):
    described = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    asked = [*described["dependencies"], *described["optional-dependencies"][extra]]
    names = {canonicalize_name(re.split(r"[\[><=]", text)[0]) for text in asked} - {"microrad"}
    assert names <= pins("hashes/lab.txt").keys() | (pins("hashes/test.txt").keys() if file == "test" else set())


@pytest.mark.promise("readme-3")
def test_make_installs_by_the_hashes():
    text = (ROOT / "Makefile").read_text(encoding="utf-8")
    hashed = text[text.index("Linux-x86_64-glibc") : text.index("\nelse\n")]
    assert hashed.count("--require-hashes --requirement hashes/") == 2
    assert "--no-deps --no-build-isolation --editable ." in hashed
    assert "--constraint" not in hashed


@pytest.mark.promise("readme-3", "releasing-5")
def test_make_installs_by_the_hashes_on_linux_with_each_python_that_is_supported_and_by_versions_elsewhere():
    text = (ROOT / "Makefile").read_text(encoding="utf-8")
    described = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    minors = [each.rpartition("3.")[2] for each in described["classifiers"] if ":: 3." in each]
    assert minors == ["11", "12", "13", "14"]
    assert f"$(foreach minor,{' '.join(minors)},Linux-x86_64-glibc-3.$(minor))" in text
    elsewhere = text[text.index("\nelse\n") : text.index("\nendif")]
    assert elsewhere.count("$(PIP) --constraint constraints.txt --editable") == 2


@pytest.mark.promise("readme-3", "readme-30")
def test_pip_alone_installs_pinned_versions_by_the_commands_of_the_readme():
    text = (ROOT / "README.md").read_text(encoding="utf-8").partition("With pip instead:")[2]
    _, install, run = (line.split() for line in text.strip("\n").partition("\n\n")[0].splitlines())
    assert install[1:] == ["install", "--constraint", "constraints.txt", "."]
    assert run[0] == ".venv/bin/microrad" and (ROOT / run[-1]).is_file()
    described = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    asked = {canonicalize_name(re.split(r"[\[><=]", each)[0]) for each in described["dependencies"]}
    assert asked and asked <= pins("constraints.txt").keys()


@pytest.mark.promise("decisions-1", "decisions-2", "readme-2", "readme-29")
def test_make_demo_and_make_test_do_what_the_readme_says():
    said = {}
    for target in ("demo", "test"):
        command = ["make", "--dry-run", "--no-print-directory", target, "VENV=.none", "FIRST="]
        said[target] = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True).stdout
    assert said["demo"].rstrip().endswith(".none/bin/microrad run missions/leo-geo.toml --output demo --overwrite")
    assert "-m venv .none" in said["demo"] and "sys.version_info < (3, 11)" in said["demo"]
    for program in (
        "lint-imports",
        "ruff check .",
        "ruff format --check .",
        "mypy",
        "scripts/numbers check",
        "-m pytest",
    ):
        assert f".none/bin/{program}" in said["test"] or f".none/bin/python {program}" in said["test"], program


@pytest.mark.promise("readme-2")
@pytest.mark.parametrize(
    ("user", "sudo", "code"), [(0, 1, 0), (1000, 0, 0), (1000, 1, 1)], ids=["root", "sudo", "user"]
)
def test_the_package_of_venv_is_installed_or_named(tmp_path, user, sudo, code):
    for name, body in (
        ("id", f"echo {user}"),
        ("sudo", f'[ "$1" = -n ] && exit {sudo}; exec "$@"'),
        ("apt-get", "echo $@"),
    ):
        (tmp_path / name).write_text(f"#!/bin/sh\n{body}\n", encoding="utf-8")
        (tmp_path / name).chmod(0o755)
    (tmp_path / "apt-get").write_text(f'#!/bin/sh\necho "$@" >> {tmp_path}/asked\n', encoding="utf-8")
    command = ["sh", ROOT / "scripts" / "install-venv", sys.executable]
    path = {"PATH": f"{tmp_path}:/usr/bin:/bin"}
    done = subprocess.run(command, env=path, capture_output=True, text=True, check=False)
    package = f"python3.{sys.version_info.minor}-venv"
    assert (done.returncode, package in done.stderr) == (code, True)
    asked = tmp_path / "asked"
    assert (asked.read_text() if asked.exists() else "") == (
        f"update -qq\ninstall -y -qq {package}\n" if code == 0 else ""
    )
    assert ("sudo apt-get install" in done.stderr) is (code == 1)


def test_doctor_refuses_other_versions_than_the_tested_ones(tmp_path, monkeypatch, call):
    pinned = tmp_path / "constraints.txt"
    monkeypatch.setattr(integrity, "_CONSTRAINTS", (tmp_path / "in-a-wheel.txt", pinned))
    assert installation._pins().ok and installation._pins().found.startswith("not compared")
    numpy, scipy = metadata.version("numpy"), metadata.version("scipy")
    pinned.write_text(f"numpy=={numpy}\nnot-there==1.0\n")
    assert installation._pins() == installation.Check("pinned versions", True, "those of constraints.txt")
    pinned.write_text("numpy==1.0.1\nnot-there==1.0\nscipy==1.0.2\n")
    found = installation._pins()
    assert not found.ok
    assert found.found == (
        f"not those of constraints.txt: numpy {numpy} (tested: 1.0.1), scipy {scipy} (tested: 1.0.2)"
    )
    assert found.advice == ("in the project's folder: python -m pip install --constraint constraints.txt numpy scipy")
    result = call("doctor")
    assert result.code == 1
    assert f"problem pinned versions {found.found}; {found.advice} ok kernels " in " ".join(result.out.split())
    assert integrity.integrity().versions == (f"numpy {numpy} (tested: 1.0.1)", f"scipy {scipy} (tested: 1.0.2)")
    assert not integrity.integrity().whole
    pinned.rename(tmp_path / "in-a-wheel.txt")
    found = installation._pins()
    assert found.ok
    assert found.found.startswith(f"not all of those that were tested: numpy {numpy}")


def test_doctor_tells_of_a_library_that_does_not_load_by_a_line():
    without = "import sys; sys.modules['numpy'] = None; "
    code = "from microrad.cli import installation; print(installation.text(installation.run(), 99))"
    ran = subprocess.run([sys.executable, "-c", without + code], capture_output=True, text=True, check=False)
    assert ran.returncode == 0, ran.stderr
    assert re.search(r"^problem  numpy +ModuleNotFoundError", ran.stdout, re.MULTILINE)


def test_doctor_keeps_to_80_columns_and_cuts_no_word():
    path = f"/{'folder' * 20}"
    checks = (
        installation.Check("python", True, "3.11"),
        installation.Check("kernels", False, f"{path} is not writable", "set NUMBA_CACHE_DIR " * 5),
    )
    lines = installation.text(checks, 80).splitlines()
    assert lines[:3] == ["ok       python            3.11", "problem  kernels", f"{' ' * 9}{path}"]
    assert len(lines) > 4
    assert all(len(line) <= 80 or line.split() == [path] for line in lines)
    assert all(line.startswith(("ok ", "problem ", " " * 9)) for line in lines)


# --------------------------------------------------------------------------------------------------------- the licences
def rows_of(page):
    """The rows of the table of licences."""
    return page.removeprefix(licences.HEAD).removesuffix(licences.TAIL).splitlines()


@pytest.mark.promise("licences-1", "licences-2", "readme-3", "readme-28")
def test_the_extras_of_the_page_of_licences_are_those_of_users():
    described = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert described["license"] == "BSD-3-Clause"
    assert (ROOT / "LICENSE").read_text(encoding="utf-8").startswith("BSD 3-Clause License\n")
    assert set(licences.EXTRAS) == described["optional-dependencies"].keys() - {"test", "benchmark"}
    rows = rows_of(licences.PAGE.read_text(encoding="utf-8"))
    assert {by for row in rows for by in row.split("|")[-2].strip().split(", ")} == {"microrad", *licences.EXTRAS}


@pytest.mark.promise("licences-1", "licences-2")
def test_the_page_of_licences_is_what_the_packages_state():
    page = licences.PAGE.read_text(encoding="utf-8")
    assert page.startswith(licences.HEAD) and page.endswith(licences.TAIL)
    listed = {canonicalize_name(row.split(" | ")[0][2:]): row for row in rows_of(page)}
    pinned, stated = pins("constraints.txt"), dict(licences.rows())
    for name in pinned.keys() & stated.keys():
        if metadata.version(name) == pinned[name]:
            assert listed[name] == stated[name]
    assert stated.keys() & pinned.keys() <= listed.keys() <= pinned.keys()
    assert listed["nptdms"] == "| npTDMS | LGPL-3.0-only | lab |"
    assert not [row for row in listed.values() if "GPL" in row and row.endswith("| microrad |")]


@pytest.mark.promise("licences-1")
def test_only_files_of_tdms_need_nptdms_and_no_module_needs_it_to_be_loaded():
    package, found = ROOT / "src" / "microrad", {}
    for path in package.rglob("*.py"):
        text = path.read_text(encoding="utf-8")
        tree = ast.parse(text if "nptdms" in text else "")  # an import names it
        for node in ast.walk(tree):
            names = [each.name for each in node.names] if isinstance(node, ast.Import) else []
            names += [node.module or ""] if isinstance(node, ast.ImportFrom) and not node.level else []
            if "nptdms" in {name.partition(".")[0] for name in names}:
                found.setdefault(path.relative_to(package).as_posix(), []).append(node in tree.body)
    assert found.keys() == {"lab/recording/formats/tdms.py", "lab/bench/folder.py"}
    assert not any(at_once for each in found.values() for at_once in each)


@pytest.mark.promise("licences-1")
def test_nothing_of_the_listed_packages_stands_in_the_package():
    """What others wrote says so; of these are the script of reports, and the headers of FMI."""
    package = ROOT / "src" / "microrad"
    words = re.compile(rb"Copyright|SPDX-License|Licensed under")
    others = {path for path in package.rglob("*") if path.is_file() and path.suffix != ".pyc"}
    held = {path.relative_to(package).as_posix() for path in others if words.search(path.read_bytes())}
    assert {name.rpartition("/")[0] for name in held} == {
        "report/page/vendor",
        "export/fmi/headers",
        "export/templates",
    }
    listed = {canonicalize_name(row.split(" | ")[0][2:]) for row in rows_of(licences.PAGE.read_text(encoding="utf-8"))}
    assert "numpy" in listed and not any("plotly" in name or "fmi" in name for name in listed)
