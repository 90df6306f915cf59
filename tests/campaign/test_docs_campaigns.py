"""docs/campaigns.md: each command and example of the page runs, and prints what stands there."""

import io
import math
import os
import re
import shutil
import signal
import socket
import subprocess
import sys
from contextlib import redirect_stdout
from pathlib import Path

import numpy as np
import pytest

from command_line import Result
from microrad import cli
from microrad.campaign import bundle, run
from microrad.campaign.definition import tables
from microrad.campaign.definition.reader import block_rows
from microrad.campaign.engines import cluster
from microrad.campaign.file import load_campaign
from microrad.campaign.records import Chunk
from microrad.campaign.rows import sampling
from microrad.campaign.statistics import sensitivity, summary
from microrad.campaign.statistics.cell import CellRows
from microrad.campaign.statistics.intervals import proportion_interval
from places import ROOT
from small_campaign import without_worker
from waiting import HANG_S

for _extra in ("distributed", "pyarrow", "h5netcdf"):
    pytest.importorskip(_extra)

PAGE = (ROOT / "docs" / "campaigns.md").read_text(encoding="utf-8")
SAID = " ".join(re.sub(r"\n- ", " ", PAGE).split())
COMMANDS = [line.split("#")[0].split() for line in re.findall(r"(?m)^    ((?:microrad|dask) .*)$", PAGE)]
FILES = dict(
    zip(
        ("links.toml", "loop.toml", "rare.toml", "tail.toml", "aperture.toml"),
        re.findall(r"```toml\n(.*?)```", PAGE, flags=re.DOTALL),
        strict=True,
    )
)
STATUS, EXPORTED, PYTHON = re.findall(r"```text\n(.*?)```", PAGE, flags=re.DOTALL)
PACE = re.compile(r"(?m)^Complete: .*$")
READ_BACK, IN_PYTHON = re.findall(r"```python\n(.*?)```", PAGE, flags=re.DOTALL)


def told(*sentences):
    """These words stand on the page, wherever its lines break."""
    for sentence in sentences:
        assert sentence in SAID, sentence


def call(*args):
    """A command in this process."""
    out = io.StringIO()
    with pytest.raises(SystemExit) as stop, redirect_stdout(out):
        cli.app(args=list(args), prog_name="microrad")
    return Result(int(stop.value.code or 0), out.getvalue(), "")


def command(*words):
    """A command of the page, as it stands there."""
    assert list(words) in COMMANDS, words
    return call(*words[1:])


def below(name):
    """What the page says that a file comes to: the comments at its end."""
    return " ".join(line[2:] for line in FILES[name].splitlines() if line.startswith("# "))


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """The files of the page beside those of `microrad campaign init`, and the first campaign run."""
    path = tmp_path_factory.mktemp("campaigns")
    before = Path.cwd()
    os.chdir(path)
    patch = pytest.MonkeyPatch()
    without_worker(patch)
    try:
        assert command("microrad", "campaign", "init").code == 0
        assert command("microrad", "init", "--preset", "paper").code == 0
        for name, text in FILES.items():
            path.joinpath(name).write_text(text, encoding="utf-8")
        ran = command("microrad", "campaign", "run", "links.toml")
        assert ran.code == 0
        assert command("microrad", "campaign", "export", "links.ledger", "rows.csv").code == 0
        yield path, ran.out
    finally:
        patch.undo()
        os.chdir(before)


def first_sentence(text):
    return " ".join(text.split("\n\n")[0].split())


# -------------------------------------------------------------------------------------------------------- commands
@pytest.mark.promise("campaigns-2")
def test_every_command_of_the_page_is_run_here():
    text = Path(__file__).read_text(encoding="utf-8")
    for words in COMMANDS:
        if words[0] == "microrad" and "--scheduler" not in words:
            assert ", ".join(f'"{word}"' for word in words) in text, words
    assert [words[:2] for words in COMMANDS if words[0] == "dask"] == [["dask", "scheduler"], ["dask", "worker"]]


@pytest.mark.promise("campaigns-4", "campaigns-7")
def test_the_links_come_to_what_stands_below_their_file(folder):
    assert first_sentence(folder[1]) == below("links.toml")


@pytest.mark.promise("campaigns-2")
def test_status_resume_verify_and_report_of_a_campaign_that_is_complete(folder):
    again = command("microrad", "campaign", "status", "links.ledger")
    assert again == (0, folder[1], "")
    resumed = command("microrad", "campaign", "resume", "links.ledger")
    assert resumed.code == 0 and PACE.sub("", resumed.out) == PACE.sub("", again.out)
    verified = command("microrad", "campaign", "verify", "links.ledger")
    assert verified.code == 0 and "right checksum" in verified.out
    assert command("microrad", "campaign", "report", "links.ledger").code == 0
    assert folder[0].joinpath("links.html").read_text(encoding="utf-8").endswith("</html>")


@pytest.mark.promise("campaigns-7", "campaigns-29")
def test_a_precision_ends_before_its_most_rows_where_it_is_reached(folder):
    rows = [int(line.split(",")[0]) for line in folder[0].joinpath("rows.csv").read_text().splitlines()[1:]]
    per_cell = [rows.count(cell) for cell in range(2)]
    assert min(per_cell) >= 512 and max(per_cell) <= 4096 and min(per_cell) < 4096


@pytest.mark.promise("readme-12")
@pytest.mark.promise("campaigns-1", "campaigns-18", "campaigns-30", "campaigns-31", "campaigns-33")
def test_the_loop_prints_what_stands_on_the_page(folder, monkeypatch):
    monkeypatch.setenv("COLUMNS", "110")
    ran = call("campaign", "run", "loop.toml", "--json")
    shown = call("campaign", "status", "loop.ledger")
    assert ran.code == shown.code == 1  # a limit is missed
    lines = iter(" ".join(line.split()) for line in shown.out.splitlines())
    for line in STATUS.splitlines():  # in their order; the page leaves some out
        assert " ".join(line.split()) in lines, line
    assert first_sentence(shown.out).startswith(below("loop.toml"))


@pytest.mark.promise("readme-12")
@pytest.mark.promise("campaigns-26")
def test_a_rare_radius_of_the_loop(folder):
    ran = call("campaign", "run", "tail.toml")
    assert ran.code == 0
    assert below("tail.toml") in " ".join(ran.out.split())


@pytest.mark.endurance
@pytest.mark.promise("campaigns-40")
def test_the_optimum_keeps_the_limit_on_fresh_rows(folder):
    found = command("microrad", "campaign", "optimise", "aperture.toml")
    assert found.code == 0
    assert below("aperture.toml") in " ".join(found.out.split())
    assert "Fresh rows " in found.out


@pytest.mark.promise("campaigns-50")
def test_exports_read_back_as_the_page_says(folder, capsys):
    for name in ("rows.parquet", "rows.nc"):
        assert call("campaign", "export", "links.ledger", name).code == 0
    assert ["microrad", "campaign", "export", "links.ledger", "rows.parquet"] in COMMANDS
    assert ["microrad", "campaign", "export", "links.ledger", "rows.nc"] in COMMANDS
    exec(READ_BACK, {})
    assert capsys.readouterr().out == EXPORTED


@pytest.mark.promise("campaigns-39", "campaigns-59")
def test_python_prints_what_stands_below_it(folder, capsys):
    exec(IN_PYTHON, {})
    assert capsys.readouterr().out == PYTHON
    told("below 4.56 W, with probability 0.0017")
    watt = 5.0 * 10.0**-0.04
    assert watt == pytest.approx(4.56, abs=0.005)
    exact = 0.5 * math.erfc((5.0 - watt) / 0.15 / math.sqrt(2.0))
    assert exact == pytest.approx(0.0017, abs=5e-5)
    assert float(re.search(r"missed ([\d.]+)", PYTHON)[1]) == pytest.approx(exact, rel=0.25)


@pytest.mark.promise("campaigns-23", "campaigns-24")
def test_drawn_too_far_out_the_mean_is_wrong_as_the_page_warns(folder):
    told("a few rows near 5 W carry nearly all the weight of means and quantiles")
    text = FILES["rare.toml"].replace('mean = "4.7 W"', 'mean = "4.4 W"').replace('"0.25 W"', '"0.15 W"')
    path = folder[0] / "far.toml"
    path.write_text(text, encoding="utf-8")
    errors, missed, warned = {}, {}, {}
    for name in ("far.toml", "rare.toml"):
        campaign = load_campaign(folder[0] / name)
        drawn, weight = sampling.rows(campaign, 0, 0, 1024)
        margin_db = 3.0 + 10.0 * np.log10(drawn["communication.transmit_power"] / 5.0)
        errors[name] = abs((weight * margin_db).sum() / weight.sum() - 3.0)
        columns = {"row": np.arange(1024.0), "weight": weight, "margin": margin_db}
        cell = CellRows(campaign, 0, [Chunk(0, 0, columns, (), np.zeros(0), np.zeros(0))])
        missed[name], (warned[name],) = cell.summary(()).missed, summary._warnings(campaign, [cell])
    assert errors["far.toml"] == pytest.approx(0.2, abs=0.05)
    assert errors["rare.toml"] < 0.02
    found = missed["rare.toml"]
    told(f"{100 * found.value:.3f} %, {100 * found.low:.3f} to {100 * found.high:.3f} %")
    told("known as 80 000 rows without weights would know it")
    plain = proportion_interval(80_000 * found.value, 80_000, 0.95)
    assert found.high - found.low == pytest.approx(plain.high - plain.low, rel=0.05)
    assert missed["far.toml"].low < found.value < missed["far.toml"].high  # still right
    told("worth for a mean, 9 of 1024 there and 329 above")
    worth = [float(words.rpartition("worth ")[2].split()[0]) for words in (warned["far.toml"], warned["rare.toml"])]
    assert [round(each) for each in worth] == [9, 329]


# --------------------------------------------------------------------------------------------------------- a cluster
def free_port():
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return str(probe.getsockname()[1])


@pytest.fixture
def cluster_commands():
    """The page's commands of a cluster, on a free port; the scheduler and its workers run."""
    port = free_port()
    scheduler, worker, begin = (
        [word.replace("8786", port) for word in words]
        for words in COMMANDS
        if words[0] == "dask" or "--scheduler" in words
    )
    assert worker[-2:] == ["--nworkers", "2"]
    dask = shutil.which("dask", path=str(Path(sys.executable).parent)) or shutil.which("dask")
    assert dask, "distributed brings dask"
    begun = [
        subprocess.Popen(
            [dask, *words[1:], "--no-dashboard"],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
        )
        for words in (scheduler, worker)
    ]
    try:
        yield begin
    finally:
        for process in reversed(begun):
            os.killpg(process.pid, signal.SIGTERM)
        for process in reversed(begun):
            process.wait(HANG_S)


@pytest.mark.endurance
@pytest.mark.promise("decisions-1", "readme-12")
@pytest.mark.promise("campaigns-3", "campaigns-51")
def test_a_cluster_gives_the_same_bytes(folder, cluster_commands, monkeypatch):
    told("cluster.csv is rows.csv to the byte")
    monkeypatch.setattr(cluster, "_CONNECT_S", HANG_S)  # the scheduler is only starting
    ran = call(*cluster_commands[1:])
    assert ran.code == 0 and first_sentence(ran.out) == below("links.toml")
    assert command("microrad", "campaign", "export", "cluster.ledger", "cluster.csv").code == 0
    assert (folder[0] / "cluster.csv").read_bytes() == (folder[0] / "rows.csv").read_bytes()


# ------------------------------------------------------------------------------------------------------------ figures
@pytest.mark.promise("campaigns-46", "campaigns-52")
def test_words_in_quotes_are_those_of_the_program():
    """What a user sees, in the table of the ledger and on a cluster."""
    sources = "".join(path.read_text(encoding="utf-8") for path in (ROOT / "src" / "microrad").rglob("*.py"))
    survival = PAGE[PAGE.index("| what happens |") : PAGE.index("After any of them")]
    seen = re.findall(r'"([a-z][^"]*)"', survival)
    assert len(seen) >= 8
    for words in [*seen, "runs other code of microrad", "at least "]:
        assert words in sources, words


@pytest.mark.promise(
    "campaigns-5",
    "campaigns-16",
    "campaigns-38",
    "campaigns-39",
    "campaigns-52",
    "campaigns-53",
    "campaigns-54",
    "campaigns-55",
    "campaigns-56",
)
def test_figures_of_the_page_are_those_of_the_program():
    import dask
    import distributed  # noqa: F401  brings its configuration

    told(
        "(`distributed.scheduler.allowed-failures` of Dask, 3)",
        "without any for 60 s",
        "no longer answers for 20 s (10 s at the first call)",
    )
    assert dask.config.get("distributed.scheduler.allowed-failures") == 3
    assert (cluster._NO_WORKERS_S, cluster._ANSWER_S, cluster._CONNECT_S) == (60.0, 20.0, 10.0)
    told("less than 80 % of the variance", "Fewer than 64 good rows", "more than 20 000")
    assert (sensitivity.SURROGATE_Q2, sensitivity.FEWEST_ROWS, sensitivity.MOST_ROWS) == (0.8, 64, 20_000)
    told("an eighth of the runs, a power of two from 16 to 4096", "no sign of life for `row_limit` and 30 s more")
    assert [block_rows(runs) for runs in (1, 512, 10**6)] == [16, 64, 4096]
    assert run.LATE_S == 30.0
    told("`row_limit` (5 min)", "`worst` (3)")
    fields = tables.CampaignTable.model_fields
    assert (fields["row_limit_s"].default, fields["worst"].default) == (300.0, 3)
    told("NumPy, SciPy, Numba, llvmlite, sgp4 and skyfield")
    assert bundle.LIBRARIES == ("numpy", "scipy", "numba", "llvmlite", "sgp4", "skyfield")
