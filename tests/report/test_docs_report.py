"""docs/report.md, docs/studio.md, CONTRIBUTING.md: commands exist, names are there, numbers are those of the code."""

import re
import shlex
import tomllib
from dataclasses import replace
from importlib import import_module, util

import pytest
import typer
import xarray as xr

from microrad import cli, report
from microrad.core import kept, machine
from microrad.mission import toml as document
from microrad.report.plotting import palette
from microrad.report.results import comparison as compared
from microrad.report.results import tolerances
from microrad.report.results.arrays import study_netcdf
from microrad.report.results.manifest import MOST_INPUT_BYTES
from microrad.report.study.page import study_views
from microrad.studio import server, session
from microrad.studio.guard import address
from microrad.studio.guard import middleware as guard
from microrad.studio.jobs import process as jobs_process
from microrad.studio.recordings import reading, uploads
from places import ROOT
from shipped import default_study, plain_drawn, plain_study, whole_study

FINE = ("Fine pointing under vibration and noise", "Monte Carlo tails", "Pointing error budget")

CONTRIBUTING = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
REPORT, STUDIO = ((ROOT / "docs" / f"{name}.md").read_text(encoding="utf-8") for name in ("report", "studio"))
NAMED = r"`((?:src|tests|benchmarks|docs|studio|report|link|loop|lab|mirror|mission|core)/[\w/.*-]+)`"


def told(text, *sentences):
    """These words stand on the page, wherever its lines break."""
    said = " ".join(re.sub(r"\n- ", " ", text).split())
    for sentence in sentences:
        assert sentence in said, sentence


# ------------------------------------------------------------------------------------------------------------ commands
def commands(text):
    """Command lines of a page: in blocks by themselves, and between backticks."""
    blocks = re.findall(r"(?m)^    (?:.*: )?microrad (.*?)(?: +#.*)?$", text)
    return sorted({*blocks, *re.findall(r"`microrad ([^`]+)`", text)})


@pytest.mark.parametrize("line", [*commands(REPORT), *commands(STUDIO)])
def test_each_command_and_option_exists(line):
    command, words = typer.main.get_command(cli.app), shlex.split(line)
    while hasattr(command, "commands") and words and words[0] in command.commands:
        command, words = command.commands[words[0]], words[1:]
    assert command.name != "root"
    assert not hasattr(command, "commands") or not words, words
    known = {each for parameter in command.params for each in parameter.opts}
    assert {word for word in words if word.startswith("-")} <= known


def test_the_pages_have_commands():
    assert {"reproduce leo-geo-study/report.html", "budget --html"} <= set(commands(REPORT))
    assert {"studio leo-geo.toml", "studio --expose-to-network 192.168.1.7"} <= set(commands(STUDIO))


@pytest.mark.parametrize("text", [REPORT, STUDIO], ids=["report", "studio"])
def test_pages_that_are_linked_exist(text):
    links = re.findall(r"\]\((?!https?:)([^)#]+)", text)
    assert all((ROOT / "docs" / link).is_file() for link in links)


# -------------------------------------------------------------------------------------------------------------- report
@pytest.mark.promise("report-6")
def test_the_parts_of_the_report_are_those_of_the_page():
    """Of a whole study; those of the fine-pointing loop and of a budget of errors are not in this one."""
    parts = re.findall(r"(?m)^\| (.+?) \|", REPORT.partition("| part | says |")[2].partition("\n\n")[0])
    titles = [view.title.partition(" (")[0] for view in study_views(plain_study(), plain_drawn())]
    assert [each for each in parts if each not in FINE] == [*titles, "Manifest"]
    assert [each for each in parts if each in FINE] == list(FINE)


@pytest.mark.promise("report-8")
def test_each_requirement_stands_in_the_table():
    """As the shipped mission has them: with a share of the time for its "a share", and without what varies behind."""
    measured = (ROOT / "reference" / "mission-shipped.json").read_text(encoding="utf-8")
    names = set(re.findall(r'"requirements\.([^"]*)\.mark"', measured))
    rows = re.search(r"(?s)\| requirement \|.*?\n\n", REPORT)[0].splitlines()[2:]
    listed = [name for row in rows if (cell := row.split("|")[1:2]) for name in cell[0].strip().split(", ")]
    assert len(names) == 6
    for name in names:
        begin = re.sub(r" [\d.]+ %.*| \(.*", "", name)
        assert any(each.startswith(begin) for each in listed), name


@pytest.mark.promise("report-5", "report-11", "report-14", "report-15", "report-16")
def test_the_numbers_of_the_report_are_those_of_the_code():
    told(REPORT, f"in words to {100 * compared.WORDS_SHARE:g} %", f"at most {palette.MOST_POINTS} points")
    assert set(re.findall(r"`([A-Z0-9_]+)`", REPORT)) == set(machine.VARIABLES)
    told(REPORT, f"up to {MOST_INPUT_BYTES / 1e6:g} MB each", f"stays below {kept.MOST_BYTES / 1e9:g} GB")


PARTS = {
    "controller_study.design_and_simulate": "the tuned and simulated fine-pointing loop",
    "coupled_study.design_and_simulate": "the tuned and simulated fine-pointing loop",
    "error_budget.judge": "the budget of pointing errors",
    "paper_cases.simulate": "the runs of the paper's loop",
    "_largest": "and by other readings",
    "paper.scan": "the scan of the paper's claims",
    "find_partner": "the acquisitions",
    "day_study.run_day_study": "the day",
    "contact_run.of_mission": "the contact in time",
    "constellation.run_constellation": "the constellation",
    "chirp": "the records of the virtual bench",
    "loops": "the records of the virtual bench",
    "pictures": "the drawn figures",
    "sensitivity_size": "the drawn figures",
    "study_netcdf": "`results.nc`",
}
"""Functions that a run hands to the parts that are kept, and what the page says of them."""


@pytest.mark.promise("report-4")
def test_the_parts_that_are_kept_are_those_of_the_page():
    rooms = [ROOT / "src" / "microrad" / room for room in ("link", "study", "report", "cli")]
    texts = [path.read_text(encoding="utf-8") for room in rooms for path in room.rglob("*.py")]
    found = {name for text in texts for name in re.findall(r"parts\.part,? ?\(?([\w.]+)", text)}
    assert found == PARTS.keys()
    section = REPORT.partition("## Parts that are kept")[2].partition("While such a part")[0]
    told(section, *PARTS.values())


@pytest.mark.promise("report-13")
def test_the_groups_of_the_results_are_those_of_the_page(tmp_path):
    """But for those of a budget of errors, which this mission does not have."""
    rows = re.findall(r"(?m)^\| (`.*?`) \|", REPORT.partition("| group | holds |")[2].partition("\n\n")[0])
    listed = []
    for row in rows:
        first, *others = re.findall("`(.*?)`", row)
        within = [first.replace(first.rpartition("/")[2], other) for other in others]
        listed += [first, *(within if "/" in first else others)]
    whole = whole_study()[0]  # of its many traces one
    (tmp_path / "results.nc").write_bytes(study_netcdf(replace(whole, runs=whole.runs[:1])))
    with xr.open_datatree(tmp_path / "results.nc", engine="h5netcdf") as tree:
        found = {node.path.removeprefix("/") for node in tree.subtree if node.variables}
    kinds = ("hysteresis_loops/", "tracking/")
    assert {each for each in listed if not each.startswith("error_budget/")} - {f"{kind}..." for kind in kinds} <= found
    assert {each for each in found if not each.startswith(kinds)} <= {*listed, "hysteresis_models"}


@pytest.mark.promise("report-17")
def test_each_kind_of_tolerance_has_its_row():
    section = REPORT.split("## Run it again")[1]
    rows = re.findall(r"(?m)^\| (\w[\w ]+) \| .* \| .* \| .* \|$", section)[1:]
    assert sorted(rows) == sorted([*tolerances.SUMMARY, "spectrum"])


# -------------------------------------------------------------------------------------------------------------- studio
def test_the_limits_of_the_studio_are_those_of_the_code():
    files, read = uploads.UploadLimits(), reading.ReadingLimits()
    rows = dict(re.findall(r"(?m)^\| (.+?) \| (.+?) \|$", STUDIO))
    assert files.file_bytes == guard.UPLOAD_BYTES == 200e6
    assert rows["a recording"].startswith("200 MB")
    assert rows["recordings in the folder"] == f"{files.files}, and {files.total_bytes / 1e9:g} GB together"
    assert rows["any other message to the server"] == f"{address.MESSAGE_BYTES / 1e6:g} MB"
    assert rows["reading one: time, computing, memory"] == (
        f"{read.wall_s:g} s, {read.cpu_s} s, {read.memory_bytes / 1e9:g} GB of address space"
    )
    assert rows["reading one: samples of a channel"] == f"{read.samples / 1e6:g} million"
    assert document.MAX_BYTES == 1_000_000
    told(STUDIO, "A file of more than 1 MB is no mission.", f"Its own things stand in `{session.STUDIO}` there")
    first, second = jobs_process.WAITS_S
    told(STUDIO, f"gets SIGTERM {first:g} s later, and SIGKILL {second:g} s behind that")


def test_the_pages_of_the_studio_are_those_of_its_navigation():
    if util.find_spec("nicegui") is None:
        pytest.skip("the studio is not installed (nicegui)")
    titles = [import_module(f"microrad.studio.pages.{name}").TITLE for name in server.PAGES]
    section = STUDIO.split("## The pages")[1].split("\n## ")[0]
    assert re.findall(r"(?m)^\| (\w+) \| .* \| `microrad", section) == titles


# -------------------------------------------------------------------------------------------------------- CONTRIBUTING
def contracts():
    return tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["importlinter"]["contracts"]


@pytest.mark.promise("decisions-2")
def test_the_table_of_rooms_is_the_contract():
    rows = re.findall(r"(?m)^\| `(\w+)` \|", CONTRIBUTING)
    assert ["__main__", *rows] == contracts()[0]["layers"]
    packages = {path.parent.name for path in (ROOT / "src" / "microrad").glob("*/__init__.py")}
    assert packages == set(rows)


def test_each_heavy_library_has_the_door_that_is_named():
    doors = re.search(r"(?s)Heavy libraries have one door each: (.*?);", CONTRIBUTING)[1]
    said = {each["name"].rpartition(": ")[2] for each in contracts() if "one door" in each["name"]}
    assert said == set(re.findall(r"in\s+`(\w+)`", doors))


@pytest.mark.parametrize("path", sorted(set(re.findall(NAMED, CONTRIBUTING))))
def test_files_that_are_named_exist(path):
    assert [*ROOT.glob(path), *(ROOT / "src" / "microrad").glob(path)]


@pytest.mark.parametrize("target", re.findall(r"(?m)^    make (\w+)", CONTRIBUTING))
def test_targets_of_make_exist(target):
    assert re.search(rf"(?m)^{target}:", (ROOT / "Makefile").read_text(encoding="utf-8"))


@pytest.mark.promise("readme-4", "readme-27")
def test_the_text_in_the_readme_is_what_the_shipped_mission_prints():
    """It says nothing of the paper's claims."""
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    assert f"```text\n{report.verdict_text(default_study(), 80)}\n```\n" in text
    assert all(len(line) <= 80 for line in text.partition("```text\n")[2].partition("```")[0].splitlines())


@pytest.mark.promise("decisions-4")
def test_contributing_says_how_to_add_what_the_page_of_decisions_names():
    page = " ".join((ROOT / "docs" / "decisions.md").read_text(encoding="utf-8").split())
    named = re.search(r"how to add an? (.*?)\.", page)[1].replace(" or ", ", ").replace(", a ", ", ")
    assert len(named.split(", ")) == 5
    for each in named.split(", "):
        assert re.search(rf"(?m)^## Add an? {each}\b", CONTRIBUTING), each
