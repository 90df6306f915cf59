"""docs/export.md: its commands run, and what it prints is what they print."""

import json
import re
import shlex

import pytest

from microrad.export.flight import build
from places import ROOT
from shipped import SHIPPED

pytest.importorskip("control")

PAGE = (ROOT / "docs" / "export.md").read_text(encoding="utf-8")
COMMANDS = [shlex.split(line, comments=True) for line in re.findall(r"(?m)^    (microrad .*)$", PAGE)]
PRINTED = re.findall(r"```text\n(.*?)```", PAGE, flags=re.DOTALL)[0]
PYTHON = re.findall(r"```python\n(.*?)```", PAGE, flags=re.DOTALL)[0]
README = (ROOT / "README.md").read_text(encoding="utf-8")


@pytest.fixture
def mission(folder):
    (folder / "leo-geo.toml").write_text(SHIPPED.read_text(encoding="utf-8"), encoding="utf-8")
    return folder


def of(name):
    """The commands of the page that begin with these words."""
    words = name.split()
    found = [each for each in COMMANDS if each[: len(words)] == words]
    assert found, name
    return found


@pytest.mark.promise("readme-5", "readme-13", "readme-14")
@pytest.mark.promise("export-2", "export-5")
@pytest.mark.skipif(build.compiler() is None, reason="no C compiler")
@pytest.mark.promise("readme-23")
@pytest.mark.promise("readme-25")
def test_flight_code_goes_from_the_mission_to_a_compiled_run(mission, call):
    (command,) = of("microrad export c")
    assert f"    {' '.join(command)}" in README
    done = call(*command[1:])
    assert done.code == 0, done.err
    for line in PRINTED.splitlines():
        assert line in done.out
    folder = mission / "leo-geo-pi_inverse"
    table = set(re.findall(r"(?m)^\| `([\w.]+)` \|", PAGE))
    assert {path.name for path in folder.iterdir()} == table - {"double", "single", "fixed"}
    bench = re.search(r"(\d+) samples of the loop: at most (\S+ \S+) off the kernel", done.out)
    assert bench and bench[1] == "5000"
    assert json.loads((folder / "manifest.json").read_text())["samples"] == 5000


@pytest.mark.promise("readme-13")
@pytest.mark.promise("export-28")
@pytest.mark.promise("readme-25")
def test_units_are_written(mission, call):
    for command in of("microrad export fmu"):
        done = call(*command[1:])
        assert done.code == 0, done.err
    assert {path.suffix for path in mission.iterdir()} == {".toml", ".fmu"}


@pytest.mark.promise("export-33", "export-35", "export-36")
def test_matrices_go_out_and_a_mirror_comes_in(mission, call, capsys):
    (out,), (into,) = of("microrad export matrices"), of("microrad import")
    for command in (out, into):
        done = call(*command[1:])
        assert done.code == 0, done.err
    assert (mission / "leo-geo-mirror.toml").is_file()
    exec(PYTHON, {})
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[1] for line in lines] == ["linear_part", "mirror", "sampled_plant", "controller", "loop"]
    assert [line.split()[0] for line in lines[:2]] == ["0", "0"]
