"""Campaigns from file to ledger: the same rows however they are run, killed, stopped, damaged or resumed."""

import itertools
import math
import os
import random
import shutil
import signal
import sqlite3
import subprocess
import sys
import tempfile
import tracemalloc
from contextlib import nullcontext
from dataclasses import dataclass, replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from scipy import stats

import microrad
from campaign_files import MIRROR, UNCERTAINTY
from microrad.campaign import bundle, records, run, work
from microrad.campaign.definition.outputs import OUTPUTS
from microrad.campaign.engines import cluster
from microrad.campaign.export import export_rows
from microrad.campaign.file import load_campaign
from microrad.campaign.ledger import Ledger, argument, chunk_format, mending
from microrad.campaign.ledger.file import is_written
from microrad.campaign.records import CampaignError, Outcome
from microrad.campaign.rows import evaluate, evaluator, loops
from microrad.campaign.rows import evaluator as rows_evaluator
from microrad.campaign.rows import plan as rows_plan
from microrad.campaign.rows.evaluator import Evaluator
from microrad.campaign.rows.loops import controllers
from microrad.campaign.rows.plan import Plan, planned
from microrad.campaign.statistics.cell import CellRows
from microrad.campaign.statistics.sensitivity import sensitivity
from microrad.campaign.statistics.summary import summarise_campaign
from microrad.core import folder, kernels
from microrad.mission.file import load_mission
from shipped import SHIPPED
from small_campaign import (
    Here,
    campaign_file,
    children,
    finished,
    halted,
    halting,
    kill,
    started,
    without_worker,
)
from waiting import HANG_S, any_moment, gone, until

OFTEN = bool(os.environ.get("MICRORAD_ENDURANCE"))
KILLS = 20 if OFTEN else 2


def begun(folder, path=None, **means):
    """A campaign run to its end in this process's own worker; its ledger."""
    book = folder / "campaign.ledger"
    run.run_campaign(path or folder / "campaign.toml", book, run.Means(**(means or {"threads": 2})))
    return book


def table(book):
    """The exported rows as text."""
    file = book.with_suffix(".csv")
    with Ledger.open(book, write=False) as opened:
        export_rows(opened, file)
    return file.read_text(encoding="utf-8")


def whole(book, campaign):
    """That every chunk is in once, with a right checksum."""
    cells, plan = range(len(campaign.cells)), planned(campaign)
    jobs = [(job.cell, job.number) for cell in cells for job in plan.chunks(cell, campaign.rows)]
    with Ledger.open(book, write=False) as opened:
        assert opened.done() == set(jobs)
    with sqlite3.connect(book) as raw:
        assert raw.execute("SELECT count(*) FROM chunks").fetchone() == (len(jobs),)
    assert mending.verify(book, jobs) == mending.Verified(len(jobs), (), (), ())


@pytest.fixture(scope="module")
def long(tmp_path_factory):
    """A campaign of two chunks in each of many cells, and the table of an undisturbed run."""
    folder = tmp_path_factory.mktemp("long")
    rates = ", ".join(f'"{100 + 10 * i} Mbit/s"' for i in range(16 if OFTEN else 8))
    grid = f'[grid]\n"communication.data_rate" = [{rates}]\n'
    path = campaign_file(folder, runs=96 if OFTEN else 65, duration="0.3 s", more=grid)
    with pytest.MonkeyPatch.context() as patch:
        without_worker(patch)
        book = begun(folder)
    return path, load_campaign(path), table(book)


def chunks_in(book):
    """The chunks that are in so far."""
    if not book.exists():
        return set()
    with Ledger.open(book, write=False) as opened:
        return opened.done()


def held(path, book):
    """A campaign's command that has halted behind its first chunk."""
    flag = book.with_suffix(".halt")
    flag.touch()
    process = started("run", path, "--ledger", book, "--threads", "1", cwd=book.parent, **halting(flag))
    halted(process.pid)
    return process


# --------------------------------------------------------------------------------------------------------------- kills
@pytest.mark.promise("decisions-1", "readme-12")
@pytest.mark.promise("campaigns-1", "campaigns-46", "campaigns-47")
@pytest.mark.usefixtures("rows_here")
def test_kills_of_worker_and_parent_change_nothing(call, long, tmp_path):
    """Where there are few kills, the first is that of a worker and the second that of the parent, which goes on."""
    path, campaign, undisturbed = long
    book, dice = tmp_path / "k.ledger", random.Random(1)
    dead, kills, parents = [], 0, 0
    threads = "2" if OFTEN else "1"
    command = ("run", path, "--ledger", book, "--threads", threads)
    process = started(*command, cwd=tmp_path)
    while process.poll() is None or kills < KILLS:
        if process.poll() is not None:  # killed, or finished before the last kill
            command = ("resume", book, "--threads", threads) if book.exists() else command
            until(lambda: not is_written(book), "the lock of a killed campaign")
            process = started(*command, cwd=tmp_path)
        if kills < KILLS:
            until(lambda p=process: p.poll() is not None or children(p.pid), "a worker or the end")
        any_moment(dice, 1.0)
        workers = children(process.pid)
        of_parent = dice.random() < 0.5 if OFTEN else bool(kills)
        victim = process.pid if of_parent or not workers else dice.choice(workers)
        fits = OFTEN or of_parent == (victim == process.pid)
        if kills < KILLS and fits and process.poll() is None and kill(victim):
            kills += 1
            parents += victim == process.pid
            dead += [process.pid, *workers] if victim == process.pid else [victim]
            if victim == process.pid:
                process.communicate(timeout=HANG_S)
        elif kills >= KILLS:
            process.communicate(timeout=HANG_S)
    assert kills == KILLS and 0 < parents < KILLS
    until(lambda: not book.exists() or not is_written(book), "the lock of a killed campaign")
    assert call("campaign", *(("resume", book) if book.exists() else command)).code in (0, 1)
    assert table(book) == undisturbed
    whole(book, campaign)
    assert gone(*dead)


@pytest.mark.promise("campaigns-2", "campaigns-4", "campaigns-46", "campaigns-47")
@pytest.mark.usefixtures("rows_here")
def test_others_may_read_its_ledger_alone_and_ctrl_c_stops_at_once_and_says_how_to_go_on(call, long, tmp_path):
    """At once: of the chunks that workers finish from then on, no more is taken in than the one that was at hand."""
    path, campaign, undisturbed = long
    book = tmp_path / "c.ledger"
    process = held(path, book)
    try:
        code, out, err = call("campaign", "resume", book)
        assert (code, out) == (2, "") and str(process.pid) in err and "Traceback" not in err
        code, out, _ = call("campaign", "status", book)
        assert code in (0, 1) and "rows" in out
        workers = children(process.pid)
        before = len(chunks_in(book))
        process.send_signal(signal.SIGINT)
        process.send_signal(signal.SIGCONT)
        _, err = process.communicate(timeout=HANG_S)
    finally:
        kill(process.pid)
        process.communicate()
    assert before <= len(chunks_in(book)) <= before + 1 < len(campaign.cells)
    assert process.returncode == 130
    assert f"microrad campaign resume {book}" in err and "Traceback" not in err
    assert workers and gone(*workers)
    assert summarise_campaign(book).progress.state == "stopped"
    assert call("campaign", "resume", book).code in (0, 1)
    assert table(book) == undisturbed


@pytest.mark.skipif(os.name != "posix", reason="elsewhere no process can be asked for by its number without harm")
def test_no_files_of_a_bundle_stay_behind_a_campaign_whose_workers_were_killed_or_live_on(monkeypatch, tmp_path):
    """Those of a cluster are processes of their own, and live on."""
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "tmp"))
    (tmp_path / "tmp").mkdir()
    path = campaign_file(tmp_path, runs=2)
    ended = subprocess.Popen([sys.executable, "-c", ""])
    ended.wait()

    class Engine(Here):
        def outcomes(self, jobs):
            yield from super().outcomes(jobs)
            cluster.install("c", run.TARGET, self.spec, bundle.code_sha256())
            cluster._openings["c"].opened()
            left = folder.scratch_folder(bundle.SCRATCH)
            left.rename(left.with_name(left.name.replace(f"-{os.getpid()}-", f"-{ended.pid}-")))
            assert len(list((tmp_path / "tmp").iterdir())) == 3

        def close(self):
            cluster.forget("c")
            vars(self).pop("work")

    monkeypatch.setattr(run.Means, "engine", lambda means, spec, late_s: Engine(spec))
    run.run_campaign(path, tmp_path / "c.ledger")
    assert list((tmp_path / "tmp").iterdir()) == []


# --------------------------------------------------------------------------------------------------- same rows, however
@pytest.fixture(scope="module")
def short(tmp_path_factory):
    """A campaign of chunks of four rows, which have loops of their own, and its table."""
    folder = tmp_path_factory.mktemp("short")
    path = campaign_file(folder, runs=16, sampling="sobol", duration="0.3 s", worst=1, more=NOISE + GRID)
    with pytest.MonkeyPatch.context() as patch:
        without_worker(patch)
        patch.setattr(run, "load_campaign", by_four)
        return path, by_four(path), table(begun(folder))


def by_four(path):
    """A campaign cut into chunks of four rows, as its ledger tells whoever does them."""
    return replace(load_campaign(path), chunk_rows=4)


NOISE = """
[inputs."fine_pointing.optical_sensor.noise"]
distribution = "uniform"
low = "0.5 urad"
high = "2 urad"
"""
GRID = """
[grid]
"communication.data_rate" = ["200 Mbit/s", "300 Mbit/s"]
"""


@pytest.mark.promise("decisions-1", "readme-12")
@pytest.mark.promise("campaigns-3", "campaigns-19", "campaigns-51")
@pytest.mark.parametrize(
    "means",
    [
        pytest.param({"threads": 1}, marks=pytest.mark.endurance, id="one"),
        pytest.param({"workers": 2}, id="two"),
        pytest.param({"workers": 3}, marks=pytest.mark.endurance, id="three"),
    ],
)
def test_any_number_of_processes_gives_the_bits_of_none(short, tmp_path, means, monkeypatch):
    path, campaign, undisturbed = short
    monkeypatch.setattr(run, "load_campaign", by_four)
    assert len(planned(campaign).chunks(0, campaign.rows)) > 2
    book = begun(tmp_path, path, **means)
    whole(book, campaign)
    assert table(book) == undisturbed


@pytest.mark.promise("readme-12")
@pytest.mark.promise("campaigns-19", "campaigns-60")
def test_rows_by_themselves_and_in_any_chunk_are_the_same(short):
    _, campaign, _ = short
    evaluator = Evaluator(campaign, dict(enumerate(controllers(campaign, _quiet))))
    together = evaluator.rows(1, range(5, 9), _still)
    apart = [evaluator.rows(1, range(row, row + 1), _still) for row in range(5, 9)]
    joined = records.joined(apart)
    for name, column in together.columns.items():
        np.testing.assert_array_equal(column, joined.columns[name])
    np.testing.assert_array_equal(together.survival, joined.survival)
    np.testing.assert_array_equal(together.survival_square, joined.survival_square)
    assert np.ptp(together.columns["residual_rms"]) > 0.0


def _quiet(done, total, what):
    pass


def _still():
    pass


@pytest.mark.promise("campaigns-5")
def test_cells_have_the_same_draws_and_differ_by_their_value(short):
    path, _, _ = short
    with Ledger.open(path.with_name("campaign.ledger"), write=False) as book:
        first, second = (list(book.chunks(cell)) for cell in (0, 1))
    power = "communication.transmit_power"
    for a, b in zip(first, second, strict=True):
        np.testing.assert_array_equal(a.columns[power], b.columns[power])
        np.testing.assert_array_equal(a.columns["residual_rms"], b.columns["residual_rms"])
        np.testing.assert_allclose(a.columns["margin"] - b.columns["margin"], 10 * np.log10(1.5), rtol=0, atol=1e-9)


# -------------------------------------------------------------------------------------------------------------- damage
@pytest.mark.promise("decisions-1", "readme-12")
@pytest.mark.promise("campaigns-46", "campaigns-47")
@pytest.mark.usefixtures("rows_here")
def test_a_flipped_bit_is_found_and_only_its_chunk_done_again(call, short, tmp_path):
    path, campaign, undisturbed = short
    book = tmp_path / "campaign.ledger"
    shutil.copy(path.with_name("campaign.ledger"), book)
    with sqlite3.connect(book) as raw:
        before = dict(raw.execute("SELECT cell * 1000 + number, rowid FROM chunks"))
    data = bytearray(book.read_bytes())
    with Ledger.open(book, write=False) as opened:
        margin = list(opened.chunks(1))[1].columns["margin"].tobytes()  # the cells differ in it alone
    assert data.count(margin[:24]) == 1
    data[data.find(margin[:24]) + 7] ^= 0x10
    book.write_bytes(data)
    code, out, _ = call("campaign", "verify", book)
    assert code == 1 and "chunk 1 of cell 1" in out and out.count("damaged:") == 1
    assert call("campaign", "resume", book).code in (0, 1)
    assert table(book) == undisturbed
    whole(book, campaign)
    with sqlite3.connect(book) as raw:
        after = dict(raw.execute("SELECT cell * 1000 + number, rowid FROM chunks"))
    assert [key for key in before if before[key] != after[key]] == [1001]
    assert call("campaign", "verify", book).code == 0


@pytest.mark.promise("decisions-1", "readme-12")
@pytest.mark.promise("campaigns-4", "campaigns-46", "campaigns-47")
@pytest.mark.usefixtures("rows_here")
def test_a_full_disk_stops_it_in_words_and_it_goes_on_once_there_is_room(call, short, tmp_path):
    path, _, undisturbed = short
    disk = tmp_path / "disk"
    disk.mkdir()
    if os.geteuid() or subprocess.run(["mount", "-t", "tmpfs", "-o", "size=4m", "tmpfs", disk], check=False).returncode:
        pytest.skip("needs the right to mount a small file system")
    try:
        book = disk / "campaign.ledger"
        (disk / "ballast").write_bytes(bytes(3_900_000))
        code, out, err = call("campaign", "run", path, "--ledger", book)
        assert (code, out) == (2, "") and "full" in err and "resume" in err and "Traceback" not in err
        (disk / "ballast").unlink()
        command = ("resume", book) if book.exists() else ("run", path, "--ledger", book)
        code, _, err = call("campaign", *command)
        assert code in (0, 1), err
        shutil.copy(book, tmp_path / "out.ledger")
    finally:
        subprocess.run(["umount", disk], check=True)
    assert table(tmp_path / "out.ledger") == undisturbed


# ------------------------------------------------------------------------------------------------------ another version
@pytest.mark.promise("campaigns-46")
def test_another_mission_or_campaign_is_refused_with_both_hashes(short, tmp_path):
    path, campaign, _ = short
    for name in ("mission.toml", "campaign.toml", "campaign.ledger"):
        shutil.copy(path.with_name(name), tmp_path / name)
    book = tmp_path / "campaign.ledger"
    with Ledger.open(book, write=True) as opened:
        opened.note("file", str(tmp_path / "campaign.toml"))
    kept = bundle.hashes(campaign)
    for name, key in (("mission.toml", "mission"), ("campaign.toml", "campaign")):
        text = (tmp_path / name).read_text(encoding="utf-8")
        (tmp_path / name).write_text(text + "\n# changed\n", encoding="utf-8")
        now = bundle.hashes(load_campaign(tmp_path / "campaign.toml"))
        with pytest.raises(CampaignError) as error:
            run.resume_campaign(book, run.Means(threads=1))
        assert kept[key] in str(error.value) and now[key] in str(error.value)
        (tmp_path / name).write_text(text, encoding="utf-8")
    run.resume_campaign(book, run.Means(threads=1))


@pytest.mark.promise("campaigns-46")
def test_other_code_is_refused_with_both_hashes(call, short, tmp_path, monkeypatch):
    path, _, _ = short
    changed = tmp_path / "changed"
    shutil.copytree(Path(microrad.__file__).parent, changed / "microrad", ignore=shutil.ignore_patterns("*.nb?"))
    with (changed / "microrad" / "lti.py").open("a", encoding="utf-8") as file:
        file.write("# another version\n")
    book = tmp_path / "campaign.ledger"
    shutil.copy(path.with_name("campaign.ledger"), book)
    code, out, err = finished("resume", book, cwd=tmp_path, PYTHONPATH=str(changed))
    assert (code, out) == (2, "") and "code" in err and bundle.code_sha256() in err and err.count("in the ledger") >= 1
    monkeypatch.setattr(bundle, "code_sha256", lambda: "another")
    assert call("campaign", "status", book).code in (0, 1)  # to look is allowed


# ---------------------------------------------------------------------------------------------------------- failed rows
@pytest.mark.promise("campaigns-8", "campaigns-16", "campaigns-46")
@pytest.mark.usefixtures("rows_here")
def test_rows_that_raise_or_never_end_are_failed_rows_and_the_rest_is_as_without_them(tmp_path, monkeypatch):
    """The clock goes by the signs of life, 0.15 s from one to the next: the machine may be as busy as it likes."""
    now_s = itertools.count(0.0, 0.15)
    monkeypatch.setattr("microrad.campaign.rows.evaluator.time", SimpleNamespace(monotonic=lambda: next(now_s)))
    more = """
[inputs."fine_pointing.duration"]
distribution = "table"
values = ["1 s", "10000 s"]
weights = [9, 1]
"""
    text = (
        ('mean = "5 W"\ndeviation = "0.2 W"', 'mean = "5 W"\ndeviation = "4 W"'),
        ('duration = "0.2 s"\nsettle = "0.1 s"', 'settle = "0.5 s"'),
    )
    path = campaign_file(tmp_path, runs=24, row_limit="1 s", more=more)
    campaign_text = path.read_text(encoding="utf-8")
    for old, new in text:
        assert old in campaign_text
        campaign_text = campaign_text.replace(old, new)
    path.write_text(campaign_text, encoding="utf-8")
    found = summarise_campaign(begun(tmp_path))
    reasons = {failed.row: failed for _, failed in found.failed}
    power, duration = found.sample["communication.transmit_power"], found.sample["fine_pointing.duration"]
    raising, endless = power <= 0.0, (duration == duration.max()) & (power > 0.0)
    assert raising.any() and endless.any()
    assert sorted(reasons) == np.flatnonzero(raising | endless).tolist()
    for row in np.flatnonzero(raising):
        assert "communication.transmit_power" in reasons[row].reason and reasons[row].attempts == 2
    for row in np.flatnonzero(endless):
        assert "row_limit, 1 s" in reasons[row].reason and reasons[row].seed == 7
    good = ~(raising | endless)
    assert np.isfinite(found.sample["margin"][good]).all() and np.isnan(found.sample["margin"][~good]).all()
    campaign = load_campaign(path)
    evaluator = Evaluator(campaign, dict(enumerate(controllers(campaign, _quiet))))
    for row in np.flatnonzero(good)[:3]:
        alone = evaluator.rows(0, range(row, row + 1), _still)
        assert alone.columns["margin"][0] == found.sample["margin"][row]


@pytest.mark.promise("campaigns-46")
def test_a_row_without_a_number_is_tried_again_by_itself_and_then_blamed(tmp_path, monkeypatch):
    campaign = load_campaign(campaign_file(tmp_path, runs=4))
    evaluator = Evaluator(campaign, dict(enumerate(controllers(campaign, _quiet))))
    good = evaluator.rows(0, range(4), _still)
    asked, outputs = [], evaluate.outputs

    def broken(file, runs, keep):
        found = outputs(file, runs, keep)
        if abs(found["margin"] - good.columns["margin"][2]) < 1e-12:
            asked.append(runs.rms_rad.shape[0])
            return found | {"margin": float("nan")}
        return found

    monkeypatch.setattr(evaluate, "outputs", broken)
    found = evaluator.rows(0, range(4), _still)
    (failed,) = found.failed
    assert (failed.row, failed.attempts, failed.reason) == (2, 2, "gives nan for margin")
    assert len(asked) == 2
    np.testing.assert_array_equal(np.delete(found.columns["margin"], 2), np.delete(good.columns["margin"], 2))
    assert np.isnan(found.columns["margin"][2])


class _Fragile:
    """An engine in this process whose worker dies of one row."""

    def __init__(self, evaluator, deadly):
        self.evaluator, self.deadly, self.asked = evaluator, deadly, []

    def outcomes(self, jobs):
        for job in jobs:
            self.asked.append(job)
            rows = planned(self.evaluator.campaign).rows_of(job.number)
            rows = range(job.row, job.row + 1) if job.kind == "row" else rows
            if job.kind != "trace" and self.deadly in rows:
                yield Outcome(job, "died", reason="the worker was killed by signal 9")
            elif job.kind != "trace":
                yield Outcome(
                    job, "done", chunk_format.pack_chunk(self.evaluator.rows(0, rows, _still, number=job.number))
                )

    def close(self):
        pass


@pytest.mark.promise("campaigns-46", "campaigns-54")
def test_a_row_that_takes_its_worker_down_is_found_and_the_rest_of_its_chunk_kept(tmp_path, monkeypatch):
    path = campaign_file(tmp_path, runs=4 * kernels.LANES, duration="10 s")
    campaign = load_campaign(path)
    rows = planned(campaign).chunk_rows
    assert campaign.rows > rows
    evaluator = Evaluator(campaign, dict(enumerate(controllers(campaign, _quiet))))
    evaluator = _Cheap(evaluator)
    engine = _Fragile(evaluator, deadly=rows + 3)
    monkeypatch.setattr(run.Means, "engine", lambda self, spec, late_s: engine)
    book = begun(tmp_path)
    whole(book, campaign)
    found = summarise_campaign(book)
    ((_, failed),) = found.failed
    assert (failed.row, failed.attempts) == (rows + 3, 2) and "signal 9" in failed.reason
    times = [(job.kind, job.row if job.kind == "row" else job.number) for job in engine.asked]
    assert times.count(("chunk", 1)) == 2 and times.count(("row", rows + 3)) == 2
    assert times.count(("chunk", 0)) == 1 and times.count(("row", rows + 2)) == 1
    assert found.cells[0].rows == campaign.rows


class _Cheap:
    """Rows of drawn inputs alone: what fails does not depend on what is computed."""

    def __init__(self, evaluator):
        self.campaign, self.evaluator = evaluator.campaign, evaluator

    def rows(self, cell, rows, beat, number=0):
        drawn = self.evaluator._drawn(cell, rows)
        columns = {"row": np.array(rows, dtype=float), "weight": drawn.weight, **drawn.columns}
        columns |= {output.name: np.ones(len(rows)) for output in self.campaign.outputs}
        survival = np.linspace(1.0, 0.0, kernels.BINS) * len(rows)
        return chunk_format.Chunk(cell, number, columns, (), survival, survival**2 / len(rows))


# ----------------------------------------------------------------------------------------------------------- precision
PRECISION = """
[precision]
output = "margin"
quantile = 0.5
half_width = "{width}"
confidence = 0.95
at_most = {most}
"""


@pytest.mark.usefixtures("rows_here")
def test_the_quantile_shown_meanwhile_is_of_nearly_all_rows_and_at_the_end_of_all(tmp_path, monkeypatch):
    sizes, said, real = [], [], run.ordered
    monkeypatch.setattr("microrad.campaign.rows.plan._CHUNK_ROWS", 2)
    monkeypatch.setattr(run, "ordered", lambda values: sizes.append(values.size) or real(values))
    (tmp_path / "mission.toml").write_text(SHIPPED.read_text(encoding="utf-8"), encoding="utf-8")
    path, book = tmp_path / "campaign.toml", tmp_path / "campaign.ledger"
    path.write_text(LINKS, encoding="utf-8")
    run.run_campaign(path, book, run.Means(), lambda done, total, what: said.append((done, what)))
    said = said[-128:]
    assert [done for done, _ in said] == list(range(2, 258, 2)) and sizes[-1] == 256
    assert sizes[:3] == [2, 4, 6] and len(sizes) < 64
    assert all(later < 1.1 * size + 2 for size, later in itertools.pairwise(sizes) if size > 4)
    with Ledger.open(book, write=False) as opened:
        margin = np.concatenate([chunk.columns["margin"] for chunk in opened.chunks(0)])
    for done, what in said:
        of = max(size for size in sizes if size <= done)
        assert what.endswith(f", margin 1 %: {np.quantile(margin[:of], 0.01, method='inverted_cdf'):.3g} dB")
    assert len({what.split("margin")[1] for _, what in said}) > 3


LINKS = """
mission = "mission.toml"
seed = 7
runs = 256
sampling = "random"

[inputs."communication.transmit_power"]
distribution = "normal"
mean = "5 W"
deviation = "0.2 W"

[limits.margin]
least = "1 dB"
"""


@pytest.mark.promise("campaigns-35")
@pytest.mark.parametrize("looks", [(), (1, 3)], ids=["at the end", "meanwhile"])
def test_rows_of_a_cell_are_in_their_order_and_their_curves_are_summed(tmp_path, looks):
    campaign = load_campaign(campaign_file(tmp_path))
    chunks = []
    for number in range(6):
        draw = np.random.default_rng(number)
        curves = draw.integers(0, 9, (2, 1056)).astype(float) if number != 2 else np.zeros((2, 0))
        columns = {"row": np.arange(4.0) + 4.0 * number, "weight": np.ones(4), "margin": draw.normal(size=4)}
        failed = (records.Failed(4 * number + 1, 7, 2, "no"),)
        chunks.append(records.Chunk(0, number, columns, failed, *curves))
    cell = CellRows(campaign, 0)
    assert cell.whole() is None
    for taken, number in enumerate((3, 0, 5, 1, 4, 2)):
        cell.take(chunks[number])
        if taken in looks:
            assert np.all(np.diff(cell.whole().columns["row"]) > 0.0)
    found, wanted = cell.whole(), records.joined(chunks)
    assert list(found.columns) == list(wanted.columns) and found.failed == wanted.failed
    for name, column in wanted.columns.items():
        np.testing.assert_array_equal(found.columns[name], column)
    np.testing.assert_array_equal(found.survival, wanted.survival)
    np.testing.assert_array_equal(found.survival_square, wanted.survival_square)
    assert (cell.rows, cell.failed) == (24, 6) and wanted.survival.any()
    held = sum(column.nbytes for chunk in cell.chunks for column in chunk.columns.values())
    assert held == 3 * 24 * 8 and not any(chunk.survival.size for chunk in cell.chunks)
    assert cell.whole().columns["margin"] is found.columns["margin"], "put together once"


@pytest.mark.promise("campaigns-21", "campaigns-32")
@pytest.mark.parametrize("sampling", ["latin-hypercube", "sobol", "random"])
def test_a_set_of_latin_or_sobol_rows_is_one_draw_of_the_mean(tmp_path, sampling):
    """Four sets of 16 rows whose means are 0 to 3: their rows say as much as these, and not as 64 of their own."""
    campaign = load_campaign(campaign_file(tmp_path, sampling=sampling))
    row = np.arange(64.0)
    columns = {each.name: row // 16 + 10.0 * (row % 16 - 7.5) for each in campaign.outputs}
    chunk = records.Chunk(0, 0, {"row": row, "weight": np.ones(64), **columns}, (), *np.zeros((2, 1056)))
    mean = CellRows(campaign, 0, [chunk]).summary().outputs["margin"].mean
    draws = columns["margin"] if sampling == "random" else np.arange(4.0)
    exact = stats.ttest_1samp(draws, 0.0).confidence_interval(0.95)
    np.testing.assert_allclose([mean.low, mean.high], [exact.low, exact.high], rtol=1e-12)


@pytest.mark.promise("campaigns-7", "campaigns-29")
@pytest.mark.usefixtures("rows_here")
def test_it_stops_when_the_wanted_quantile_is_known_well_enough(tmp_path):
    path = campaign_file(tmp_path, runs=64, more=PRECISION.format(width="0.03 dB", most=20_000))
    found = summarise_campaign(begun(tmp_path, path))
    median = found.cells[0].outputs["margin"].quantiles[0.5]
    campaign = load_campaign(path)
    rounds = planned(campaign).rounds
    assert found.progress.state == "complete" and found.cells[0].rows in rounds[:-1]
    assert (median.high - median.low) / 2.0 <= 0.03
    before = rounds[rounds.index(found.cells[0].rows) - 1] if found.cells[0].rows > rounds[0] else None
    if before is not None:
        with Ledger.open(tmp_path / "campaign.ledger", write=False) as book:
            last = len(planned(campaign).chunks(0, before))
            assert not CellRows(campaign, 0, [each for each in book.chunks(0) if each.number < last]).is_precise()


def test_a_round_is_judged_by_its_own_chunks_alone(monkeypatch):
    """A campaign that goes on has chunks of later rounds in its ledger already; one has 32 rows here."""
    plan, seen = SimpleNamespace(chunks=lambda cell, rows: range(rows // 32)), []
    kept = [SimpleNamespace(number=number) for number in range(8)]

    def rows(campaign, cell, chunks):
        seen.extend(each.number for each in chunks)
        return SimpleNamespace(is_precise=lambda: True)

    monkeypatch.setattr(run, "CellRows", rows)
    runner = SimpleNamespace(plan=plan, book=SimpleNamespace(chunks=lambda cell: kept))
    runner.campaign = SimpleNamespace(table=SimpleNamespace(precision=object()))
    assert run._Runner._precise(runner, 0, 128) and seen == [0, 1, 2, 3]


RADIUS = """
[precision]
output = "radius"
quantile = 0.99
half_width = "{width}"
confidence = 0.99
at_most = 512
"""


@pytest.mark.usefixtures("rows_here")
@pytest.mark.parametrize(("width", "rounds_done"), [("1 mrad", 1), ("0.0001 nrad", 0)])
def test_a_precision_of_the_radial_error_counts_the_time_of_all_rows(tmp_path, width, rounds_done):
    path = campaign_file(tmp_path, runs=256, more=RADIUS.format(width=width))
    rounds = planned(load_campaign(path)).rounds
    found = summarise_campaign(begun(tmp_path, path))
    assert found.cells[0].rows == rounds[rounds_done - 1] and len(rounds) > 1
    assert found.progress.state == "complete"


@pytest.mark.promise("campaigns-3")
@pytest.mark.parametrize(
    ("means", "threads"), [({}, 7), ({"threads": 3}, 3), ({"workers": 3}, 3), ({"scheduler": "tcp://head:1"}, None)]
)
def test_a_process_for_each_core_works_or_as_many_as_are_asked_for_or_a_scheduler(monkeypatch, means, threads):
    monkeypatch.setattr(os, "cpu_count", lambda: 7)
    monkeypatch.setattr(run, "LocalEngine", lambda spec, target, threads, late_s: ("here", threads, late_s))
    monkeypatch.setattr(run, "DaskEngine", lambda spec, target, address, late_s: (address, None, late_s))
    assert run.Means(**means).engine(b"", 330.0) == (means.get("scheduler", "here"), threads, 330.0)


@pytest.mark.promise("campaigns-16")
def test_the_rows_kept_in_time_are_the_worst_in_the_first_limits_output(short):
    path, campaign, _ = short
    with Ledger.open(path.with_name("campaign.ledger"), write=False) as book:
        traces = book.traces()
        margins = [np.concatenate([chunk.columns["margin"] for chunk in book.chunks(cell)]) for cell in (0, 1)]
    assert (campaign.table.worst, campaign.limits[0].output) == (1, "margin")
    assert [(each.cell, each.row, each.output) for each in traces] == [
        (cell, int(np.argmin(margin)), "margin") for cell, margin in enumerate(margins)
    ]
    assert [each.value for each in traces] == [float(margin.min()) for margin in margins]


class _Gone(Here):
    """An engine whose scheduler, or its last worker, goes away behind the first chunk."""

    said = "the scheduler at tcp://head:1 is gone"

    def outcomes(self, jobs):
        yield next(super().outcomes(jobs))
        raise CampaignError(self.said)


@pytest.mark.promise("campaigns-46", "campaigns-47", "campaigns-53", "campaigns-56")
@pytest.mark.parametrize(
    "said",
    [
        _Gone.said,
        pytest.param("the scheduler at tcp://head:1 had no worker for 60 s", marks=pytest.mark.endurance),
    ],
)
def test_an_engine_that_goes_away_leaves_what_is_done_and_another_goes_on(short, tmp_path, monkeypatch, said):
    path, _, undisturbed = short
    monkeypatch.setattr(_Gone, "said", said)
    monkeypatch.setattr(run, "load_campaign", by_four)
    book = tmp_path / "campaign.ledger"
    with monkeypatch.context() as patched:
        patched.setattr(run.Means, "engine", lambda means, spec, late_s: _Gone(spec))
        with pytest.raises(CampaignError) as caught:
            run.run_campaign(path, book, run.Means(scheduler="tcp://head:1"))
    words = f"{said}; 4 rows are in {book}. Go on with: microrad campaign resume"
    assert str(caught.value).startswith(words)
    assert len(chunks_in(book)) == 1
    without_worker(monkeypatch)
    run.resume_campaign(book, run.Means())
    assert table(book) == undisturbed


class _Faulty(Here):
    """An engine with a fault behind the first chunk."""

    def outcomes(self, jobs):
        yield next(super().outcomes(jobs))
        raise RuntimeError("a fault")


def test_a_fault_of_an_engine_comes_out_as_it_is_and_the_campaign_has_stopped(short, tmp_path, monkeypatch):
    monkeypatch.setattr(run, "load_campaign", by_four)
    monkeypatch.setattr(run.Means, "engine", lambda means, spec, late_s: _Faulty(spec))
    with pytest.raises(RuntimeError, match=r"^a fault$"):
        run.run_campaign(short[0], tmp_path / "campaign.ledger", run.Means())
    assert len(chunks_in(tmp_path / "campaign.ledger")) == 1
    assert summarise_campaign(tmp_path / "campaign.ledger").progress.state == "stopped"


@pytest.mark.promise("campaigns-35")
def test_rows_take_8_bytes_a_value_and_about_twice_as_many_while_they_are_put_together(tmp_path):
    cell, names, rows = CellRows(load_campaign(campaign_file(tmp_path)), 0), ("row", "weight", "margin", "x", "y"), 1000
    tracemalloc.start()
    try:
        for number in range(100):
            columns = {name: np.arange(rows) + float(rows * number) for name in names}
            cell.take(records.Chunk(0, number, columns, (), np.zeros(0), np.zeros(0)))
        values, held = 100 * rows * len(names), tracemalloc.get_traced_memory()[0]
        tracemalloc.reset_peak()
        cell.whole()
        now, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert held / values == pytest.approx(8.0, rel=0.05) and now / values == pytest.approx(8.0, rel=0.05)
    assert 1.9 < peak / held < 2.2


@pytest.mark.promise("campaigns-29")
def test_each_round_has_half_as_many_rows_as_all_before_in_whole_chunks_and_blocks(tmp_path):
    path = campaign_file(tmp_path, runs=256, sampling="sobol", more=PRECISION.format(width="0.02 dB", most=8192))
    campaign = load_campaign(path)
    plan = planned(campaign)
    unit = max(plan.largest_chunk, campaign.block)
    assert plan.rounds[0] == max(campaign.rows, unit) and plan.rounds[-1] == 8192 and len(plan.rounds) > 3
    for before, after in itertools.pairwise(plan.rounds):
        assert after % unit == 0 and after % campaign.block == 0
        assert 1.5 * before <= after < 1.5 * before + unit or after == 8192


@pytest.mark.promise("campaigns-45", "campaigns-52")
def test_a_campaign_in_one_piece_needs_none_of_its_files(tmp_path):
    """What a worker on another machine opens: mission, mirror and controllers are in it."""
    mirror = '[set]\nmirror = "mirror.toml"\n[inputs.mirror]\ndistribution = "identified"\n'
    path = campaign_file(tmp_path, runs=4, more=mirror)
    (tmp_path / "mirror.toml").write_text(MIRROR + UNCERTAINTY, encoding="utf-8")
    campaign = load_campaign(path)
    tuned = controllers(campaign, _quiet)
    spec, wanted = bundle.packed(campaign, tuned), Evaluator(campaign, dict(enumerate(tuned))).rows(0, range(1), _still)
    for file in tmp_path.iterdir():
        file.unlink()
    opened = bundle.opened(spec)
    found = Evaluator(opened.campaign, dict(enumerate(opened.controllers))).rows(0, range(1), _still)
    assert not found.failed and list(found.columns) == list(wanted.columns)
    for name, column in wanted.columns.items():
        np.testing.assert_array_equal(found.columns[name], column)
    assert found.columns["mirror.bouc_wen.d1"][0] != campaign.mission.mission.mirror.bouc_wen.d1_rad_v


@pytest.mark.promise("campaigns-52")
@pytest.mark.parametrize("library", [*bundle.LIBRARIES, "python", "microrad"])
def test_another_python_library_or_microrad_is_other_code(monkeypatch, library):
    own = bundle.code_sha256()
    if library == "python":
        monkeypatch.setattr(bundle.platform, "python_version", lambda: "another")
    elif library == "microrad":
        monkeypatch.setattr(bundle, "source_sha256", lambda: "another")
    else:
        real = bundle.version
        monkeypatch.setattr(bundle, "version", lambda name: "another" if name == library else real(name))
    assert bundle.code_sha256.__wrapped__() != own
    monkeypatch.undo()
    assert bundle.code_sha256.__wrapped__() == own


@pytest.mark.promise("campaigns-1", "campaigns-36", "campaigns-60")
@pytest.mark.usefixtures("rows_here")
def test_what_matters_is_told_of_the_first_cell_and_of_limited_outputs(tmp_path):
    """The second cell has limits and rows as the first, and its own sensitivities would be others."""
    more = """
[inputs."communication.pointing_error"]
distribution = "uniform"
low = "1 urad"
high = "9 urad"
[grid]
"terminals.leo_aperture" = ["3 cm", "9 cm"]
"""
    (tmp_path / "mission.toml").write_text(SHIPPED.read_text(encoding="utf-8"), encoding="utf-8")
    (tmp_path / "campaign.toml").write_text(LINKS + more, encoding="utf-8")
    found = summarise_campaign(begun(tmp_path))
    assert [each.output for each in found.sensitivities] == ["margin"] and len(found.cells[0].outputs) > 1
    cells = [found.sample["cell"] == float(number) for number in (0, 1)]
    keys = ("communication.transmit_power", "communication.pointing_error")
    first, second = (
        sensitivity({key: found.sample[key][cell] for key in keys}, found.sample["margin"][cell], "margin")
        for cell in cells
    )
    assert found.sensitivities[0] == first != second


# ------------------------------------------------------------------------------------------- decisions, one by one
@pytest.mark.parametrize(
    ("seconds", "words"),
    [(0.4, "0 s"), (89.9, "90 s"), (90.0, "2 min"), (5399.0, "90 min"), (5400.0, "1.5 h"), (36000.0, "10.0 h")],
)
def test_the_time_left_is_told_in_its_unit(seconds, words):
    assert run._minutes(seconds) == words


def test_the_pace_is_that_of_the_rows_done_here(monkeypatch):
    monkeypatch.setattr(run, "time", SimpleNamespace(monotonic=lambda: 110.0))
    pace = run._Pace(done=150, spent_s=30.0, began_s=100.0, here=50)
    assert pace.words(250, "margin 1 %: 3 dB") == "5 rows/s, 20 s left, margin 1 %: 3 dB"
    assert pace.words(150, "") == "5 rows/s, 0 s left"
    assert pace.seconds == 40.0
    assert run._Pace(done=150, spent_s=0.0, began_s=109.0, here=1234).words(250, "") == "1230 rows/s, 0 s left"
    assert run._Pace(done=150, spent_s=30.0, began_s=100.0).words(250, "x") == "rows"
    assert run._Pace(done=150, spent_s=30.0, began_s=110.0, here=50).words(250, "x") == "rows"


class Book(list):
    """A ledger that notes what is put into it."""

    def chunks(self, cell):
        return (each for each in self if each.cell == cell)


def a_chunk(number, rows, margin, cell=0):
    columns = {"row": np.array(rows, dtype=float), "weight": np.ones(len(rows)), "margin": np.array(margin)}
    return records.Chunk(cell, number, columns, (), np.zeros(0), np.zeros(0))


def a_runner(least=3.0, most=None, **table):
    """A runner without an engine, of two cells with four rows a chunk."""
    made = object.__new__(run._Runner)
    given = {"loop": object(), "tail": None, "worst": 2, "seed": 7, "precision": None}
    limits = (records.Limit("margin", least, most, ""),)
    made.campaign = SimpleNamespace(table=SimpleNamespace(**(given | table)), limits=limits, cells=[0, 1])
    made.plan = SimpleNamespace(
        rows_of=lambda number: range(4 * number, 4 * number + 4), chunks=lambda cell, rows: [0] * -(-rows // 4)
    )
    made.book, made.pace, made.total = Book(), run._Pace(0, 0.0), 16
    return made


@pytest.mark.parametrize(
    ("least", "most", "worst"),
    [(3.0, None, [(3, 1.0), (0, 2.0)]), (None, 3.0, [(4, 9.0), (1, 5.0)]), (3.0, 4.0, [(3, 1.0), (0, 2.0)])],
)
def test_the_worst_rows_are_the_least_where_a_limit_is_a_least_and_the_first_of_equal_ones(least, most, worst):
    made = a_runner(least, most)
    made.book += [a_chunk(1, [4, 5], [9.0, 2.0]), a_chunk(0, [0, 1, 2, 3], [2.0, 5.0, np.nan, 1.0])]
    made.book += [a_chunk(0, [0, 1], [0.0, 99.0], cell=1)]
    assert made._worst(0) == worst
    for other in ({"loop": None}, {"tail": object()}, {"worst": 0}):
        without = a_runner(least, most, **other)
        without.book += made.book
        assert without._worst(0) == []
    unlimited = a_runner()
    unlimited.campaign.limits = ()
    unlimited.book += made.book
    assert unlimited._worst(0) == []


@pytest.mark.parametrize(
    ("least", "most", "said"),
    [(3.0, None, "margin 1 %: 1 dB"), (None, 3.0, "margin 99 %: 9 dB"), (0.0, None, "margin 1 %: 1 dB")],
)
def test_the_quantile_shown_is_renewed_with_a_tenth_more_rows_or_at_the_end(least, most, said):
    made = a_runner(least, most)
    made.pace.here = made.pace.done = 4
    assert made._interim(chunk_format.pack_chunk(a_chunk(0, range(4), [1.0, 9.0, 5.0, 5.0]))) == said
    made.pace.quantile = "as it was"
    for here, total, shown in ((4.39, 16, "as it was"), (4.4, 16, said), (4.6, 16, "as it was"), (4.6, 4.6, said)):
        made.pace.quantile = "as it was"
        made.pace.here = made.pace.done = here
        made.total = total
        assert made._interim(chunk_format.pack_chunk(a_chunk(1, [9], [5.0]))) == shown
    lost = a_runner(least, most)
    assert lost._interim(chunk_format.pack_chunk(a_chunk(0, [0], [np.nan]))) == said.partition(":")[0] + ": -"
    lost.campaign.limits = ()
    assert lost._interim(b"") == ""


def test_rows_of_a_chunk_by_themselves_are_tried_twice_and_what_is_lost_is_said(monkeypatch):
    made, tried, kept = a_runner(), [], []

    def outcomes(jobs):
        for job in jobs:
            tried.append(job.row)
            lost = () if job.row == 4 or tried.count(6) == 2 else (records.Failed(job.row, 7, 1, "no number"),)
            chunk = a_chunk(1, [job.row], [float(job.row)])
            if job.row == 5:
                yield Outcome(job, "died", reason=f"ended, {tried.count(5)}")
            else:
                yield Outcome(job, "done", chunk_format.pack_chunk(replace(chunk, failed=lost)))

    monkeypatch.setattr(run.sampling, "rows", lambda campaign, cell, row, count: ({}, np.array([1.0])))
    made.campaign.outputs = [SimpleNamespace(name="margin")]
    made._outcomes = outcomes
    made._keep = lambda job, payload: kept.append((job, chunk_format.unpack_chunk(payload)))
    made._by_rows(records.Job(0, 1))
    ((job, chunk),) = kept
    assert tried == [4, 5, 6, 7, 5, 6, 7]
    assert job == records.Job(0, 1) and chunk.columns["row"].tolist() == [4.0, 5.0, 6.0, 7.0]
    np.testing.assert_array_equal(chunk.columns["margin"], [4.0, np.nan, 6.0, 7.0])
    failed = [(each.row, each.attempts, each.reason) for each in chunk.failed]
    assert failed == [(5, 2, "ended, 2")]


def test_a_cell_is_precise_by_the_first_rows_of_a_round_and_never_without_a_precision(monkeypatch):
    seen = []

    class Rows:
        def __init__(self, campaign, cell, chunks):
            seen.append([chunk.number for chunk in chunks])

        def is_precise(self):
            return True

    monkeypatch.setattr(run, "CellRows", Rows)
    made = a_runner(precision=object())
    made.book += [a_chunk(number, [4 * number], [1.0]) for number in (0, 2, 1, 3)]
    assert made._precise(0, 8) and made._precise(0, 9) and seen == [[0, 1], [0, 2, 1]]
    assert not a_runner()._precise(0, 8)


def test_traces_that_are_no_longer_among_the_worst_go_and_those_that_are_there_stay():
    made, dropped, put, asked = a_runner(), [], [], []
    there = records.WorstTrace(0, 3, "margin", 1.0, np.zeros(1), np.zeros((1, 1)), np.zeros((1, 1)))
    old = replace(there, row=8)
    made._worst = lambda cell: [(3, 1.0), (0, 2.0)] if cell == 0 else [(3, 5.0)]
    made.book = SimpleNamespace(traces=lambda: (there, old), drop_trace=dropped.append, put_trace=put.append)

    def outcomes(jobs):
        asked.extend(jobs)
        for job in jobs:
            found = replace(there, cell=job.cell, row=job.row, output="", value=np.nan)
            done = job.cell == 0
            yield Outcome(job, "done" if done else "died", chunk_format.pack_trace(found) if done else b"")

    made._outcomes = outcomes
    made._traces()
    assert dropped == [old]
    assert [(job.cell, job.row, job.kind) for job in asked] == [(0, 0, "trace"), (1, 3, "trace")]
    assert [(each.cell, each.row, each.output, each.value) for each in put] == [(0, 0, "margin", 2.0)]


@pytest.mark.parametrize(
    ("row_s", "largest", "rows"),
    [
        (0.0, 64, 64),
        (1e-3, 4096, 1024),
        (1e-3, 16, 16),
        (0.1, 64, 16),
        (0.25, 64, 8),
        (0.26, 64, 4),
        (1.0, 64, 2),
        (1.01, 64, 1),
        (5.0, 64, 1),
    ],
)
def test_a_timed_chunk_lasts_two_seconds_at_most(row_s, largest, rows):
    assert Plan(4, largest, (10,), True).timed_chunk(row_s) == rows


def test_chunks_of_a_plan_cover_its_rows_and_end_with_the_last():
    plan = Plan(4, 8, (8, 10), False)
    assert [[job.number for job in plan.chunks(3, rows)] for rows in (0, 1, 4, 5, 8, 10)] == [
        [], [0], [0], [0, 1], [0, 1], [0, 1, 2],
    ]  # fmt: skip
    assert {job.cell for job in plan.chunks(3, 9)} == {3}
    assert [plan.rows_of(number) for number in (0, 1, 2)] == [range(0, 4), range(4, 8), range(8, 10)]


# ------------------------------------------------------------------------------------------------------ rows by groups
@pytest.mark.parametrize(("took_s", "slow"), [(9.9, False), (10.0, False), (10.1, True)])
def test_a_row_may_take_its_limit_from_its_own_start_on(monkeypatch, took_s, slow):
    now, beats = [100.0], []
    monkeypatch.setattr(evaluator, "time", SimpleNamespace(monotonic=lambda: now[0]))
    watch = evaluator._Watch(lambda: beats.append(now[0]), 10.0, began_s=0.0)
    watch.start()
    now[0] += took_s
    if slow:
        with pytest.raises(evaluator.SlowRowError, match="took longer than row_limit, 10 s"):
            watch()
    else:
        watch()
    assert beats == [100.0, 100.0 + took_s]


@pytest.mark.parametrize(
    ("error", "words"),
    [
        (ValueError("no  power\nis left"), "no power is left"),
        (evaluator.SlowRowError("took longer"), "took longer"),
        (ValueError(""), "ValueError: "),
        (KeyError("a"), "KeyError: 'a'"),
        (RuntimeError("x"), "RuntimeError: x"),
    ],
)
def test_an_error_of_a_row_is_told_by_its_kind_where_it_was_not_written_for_a_user(error, words):
    assert evaluator._words(error) == words


def an_evaluator(outputs, simulated, *, loop=True, tail=False, keys="aabba"):
    """An evaluator of five rows from number 10 on, whose loops, outputs and runs are given."""
    made = object.__new__(Evaluator)
    table = SimpleNamespace(loop=object() if loop else None, tail=object() if tail else None, seed=3, row_limit_s=9.0)
    made.campaign, made.names = SimpleNamespace(table=table), ("margin",)
    weight = np.array([1.0, 2.0, 1.0, 1.0, 1.0])
    drawn = evaluator._Rows(0, 10, {"power": np.arange(5.0)}, weight, ["file"] * 5, [None] * 5, list(keys))
    made._drawn = lambda cell, rows: drawn
    made._simulated = simulated
    made._outputs = outputs
    return made


def curve(value):
    return np.full(kernels.BINS, value)


def test_rows_that_share_a_loop_are_simulated_together_and_one_that_fails_is_tried_again_alone():
    groups, tried = [], []

    def simulated(drawn, group, watch):
        groups.append((group.start, group.stop))
        if (group.start, group.stop) == (2, 4):
            raise RuntimeError("together")
        return "runs"

    def outputs(file, runs, row):
        tried.append(row)
        if row == 14:
            return {"margin": np.nan}, curve(9.0)
        if row == 11 and tried.count(11) == 1:
            raise ValueError("at first")
        return {"margin": float(row)}, curve(0.5)

    made = an_evaluator(outputs, simulated)
    found = made.rows(0, range(10, 15), lambda: None, number=6)
    assert groups == [(0, 2), (1, 2), (2, 4), (2, 3), (3, 4), (4, 5), (4, 5)]
    assert (found.cell, found.number, found.columns["row"].tolist()) == (0, 6, [10.0, 11.0, 12.0, 13.0, 14.0])
    np.testing.assert_array_equal(found.columns["margin"], [10.0, 11.0, 12.0, 13.0, np.nan])
    assert [(each.row, each.seed, each.attempts, each.reason) for each in found.failed] == [
        (14, 3, 2, "gives nan for margin")
    ]
    np.testing.assert_allclose(found.survival, 0.5 * (1.0 + 2.0 + 1.0 + 1.0))  # weights of the four good rows
    np.testing.assert_allclose(found.survival_square, 0.25 * (1.0 + 4.0 + 1.0 + 1.0))
    groups.clear(), tried.clear()
    once = made.rows(0, range(10, 15), lambda: None, attempts=1)
    assert groups == [(0, 2), (2, 4), (4, 5)]
    assert [(each.row, each.attempts, each.reason) for each in once.failed] == [
        (11, 1, "at first"), (12, 1, "RuntimeError: together"), (13, 1, "RuntimeError: together"),
        (14, 1, "gives nan for margin"),
    ]  # fmt: skip


@pytest.mark.parametrize(("loop", "tail", "bins"), [(True, False, kernels.BINS), (True, True, 0), (False, False, 0)])
def test_rows_have_a_curve_where_a_loop_runs_for_a_time(loop, tail, bins):
    groups = []

    def simulated(drawn, group, watch):
        groups.append(len(group))

    made = an_evaluator(lambda *given: ({"margin": 1.0}, None), simulated, loop=loop, tail=tail)
    found = made.rows(0, range(10, 15), lambda: None)
    assert found.survival.size == found.survival_square.size == bins and not found.survival.any()
    assert groups == ([2, 2, 1] if loop else [1, 1, 1, 1, 1])


def plans(**changes):
    """The plan of a campaign of these rows, of links alone."""
    table = {"loop": None, "precision": None, "seed": 3}
    given = {"outputs": [SimpleNamespace(group="link")], "rows": 300, "block": 32, "chunk_rows": None}
    given |= {"realisations": 1, "loop_varies": False, "mission": None}
    of_table = {name: changes.pop(name) for name in list(changes) if name in table}
    given["most_rows"] = getattr(of_table.get("precision"), "at_most", given["rows"])
    return planned(SimpleNamespace(**given | changes, table=SimpleNamespace(**table | of_table)))


@pytest.mark.parametrize(
    ("changes", "plan"),
    [
        ({}, Plan(256, 256, (300,), True)),
        ({"rows": 5000, "chunk_rows": 16}, Plan(16, 1024, (5000,), True)),
        ({"rows": 5, "outputs": [SimpleNamespace(group="day")]}, Plan(4, 4, (5,), False)),
        ({"outputs": [SimpleNamespace(group="link"), SimpleNamespace(group="day")]}, Plan(8, 8, (300,), False)),
        (
            {"outputs": [SimpleNamespace(group="day")], "precision": SimpleNamespace(at_most=1000), "rows": 33},
            Plan(8, 8, (64, 96, 160, 256, 384, 576, 864, 992), False),
        ),
        ({"precision": SimpleNamespace(at_most=1100), "rows": 300}, Plan(256, 256, (512, 768, 1024), True)),
        ({"precision": SimpleNamespace(at_most=600), "rows": 300, "chunk_rows": 2}, Plan(2, 256, (512,), True)),
        ({"precision": SimpleNamespace(at_most=511), "rows": 300}, Plan(256, 256, (511,), True)),
        ({"precision": SimpleNamespace(at_most=300), "rows": 300}, Plan(256, 256, (300,), True)),
    ],
)
def test_a_plan_has_the_chunks_and_rounds_of_its_rows(changes, plan):
    assert plans(**changes) == plan


@pytest.mark.parametrize(
    ("own", "varies", "few", "rows"),
    [
        (1, False, 1024, 64),  # 2e7 steps over 1.25 s of 4 us each: 64 rows fill the lanes of a batch
        (1, True, 1024, 1),
        (16, False, 1024, 4),
        (100, False, 1024, 1),
        (100, True, 1024, 1),
        (48, False, 1, 2),
    ],
)
def test_rows_of_a_chunk_fill_the_lanes_and_take_a_second(monkeypatch, own, varies, few, rows):
    fine = SimpleNamespace(plant_step_s=4e-6)
    monkeypatch.setattr(rows_plan.loops, "settings", lambda file: fine)
    monkeypatch.setattr(rows_plan.loops, "span", lambda table, f, seed: SimpleNamespace(duration_s=1.25 + 0.0 * seed))
    found = plans(loop=object(), realisations=own, loop_varies=varies, rows=few)
    assert (found.largest_chunk, found.is_timed) == (rows, False)


def test_chunks_of_several_axes_joined_keep_the_sums_of_those_that_ran():
    def part(number, rows, sums, failed=()):
        columns = {"row": np.array(rows, dtype=float), "margin": -np.array(rows, dtype=float)}
        lost = tuple(records.Failed(row, 7, 2, "lost") for row in failed)
        return records.Chunk(3, number, columns, lost, np.array(sums, dtype=float), 10.0 * np.array(sums, dtype=float))

    whole = records.joined([part(5, [8, 9], [], [9]), part(6, [10], [1, 2]), part(7, [11, 12], [0.5, 4], [12, 11])])
    assert (whole.cell, whole.number, [each.row for each in whole.failed]) == (3, 5, [9, 12, 11])
    assert (whole.columns["row"].tolist(), whole.columns["margin"].tolist()) == (
        [8, 9, 10, 11, 12],
        [-8, -9, -10, -11, -12],
    )
    assert (whole.survival.tolist(), whole.survival_square.tolist()) == ([1.5, 6.0], [15.0, 60.0])
    none = records.joined([part(5, [8], []), part(6, [9], [])])
    assert none.survival.size == none.survival_square.size == 0


def test_a_weighted_row_and_a_simulated_one_are_those_of_their_number():
    weighted = rows_evaluator._Weighted(128, np.array([1e-6, 2e-6, 3e-6]), np.array([-0.5, 0.25, 1.5]))
    assert weighted.row(129) == {"tail_radius": 2e-6, "tail_log_weight": 0.25}
    assert weighted.row(130) == {"tail_radius": 3e-6, "tail_log_weight": 1.5}
    runs = SimpleNamespace(part=lambda first, count: (first, count))
    assert rows_evaluator.Simulated(128, 5, runs).row(131) == (15, 5)


def test_the_head_of_a_ledger_has_a_column_for_each_number_of_a_row(monkeypatch):
    monkeypatch.setattr(run.bundle, "hashes", lambda campaign: {"campaign": campaign.sha256})
    campaign = SimpleNamespace(
        path=Path("folder") / "name.of.it.toml",
        text="the text",
        sha256="aa",
        mission=SimpleNamespace(mission=SimpleNamespace(name="a mission")),
        table=SimpleNamespace(seed=2**64 - 1),
        inputs=(records.InputText("a.b", "W", "normal"), records.InputText("c", "", "uniform")),
        outputs=(OUTPUTS["data_rate"], OUTPUTS["outage"]),
        cells=[SimpleNamespace(values={"x": "1"}), SimpleNamespace(values={"x": "2"})],
    )
    head = run._head(campaign, b"bundle")
    assert [tuple(column) for column in head.columns] == [
        ("row", "", "number of the row in its cell"),
        ("weight", "", "weight of the row"),
        ("a.b", "W", "drawn"),
        ("c", "", "drawn"),
        ("data_rate", "bit/s", "data rate that keeps requirement.margin but for the outage"),
        ("outage", "", "share of the time with less than 0 dB"),
    ]
    assert (head.campaign_name, head.campaign_text, head.mission_name) == ("name.of.it", "the text", "a mission")
    assert (head.seed, head.hashes, head.bundle) == (2**64 - 1, {"campaign": "aa"}, b"bundle")
    assert head.cells == ({"x": "1"}, {"x": "2"})
    assert list(head.versions) == ["microrad", "numpy", "scipy", "numba", "llvmlite", "sgp4", "skyfield"]


def test_what_is_told_of_a_campaign_that_stops_is_how_to_go_on(monkeypatch):
    made = a_runner()
    made.book, made.pace.done = SimpleNamespace(path=Path("a folder") / "b.ledger"), 12
    path = Path("a folder") / "b.ledger"
    assert made._stopped() == f"12 rows are in {path}. Go on with: microrad campaign resume {argument(path)}"


def test_runs_of_consecutive_rows_are_told_apart_by_row():
    picked = []
    runs = SimpleNamespace(part=lambda first, count: picked.append((first, count)))
    for row in (40, 41, 43):
        evaluator.Simulated(40, 3, runs).row(row)
    assert picked == [(0, 3), (3, 3), (9, 3)]
    weighted = evaluator._Weighted(40, np.array([1.5, 2.5, 4.5]), np.array([-0.25, 0.75, -3.0]))
    assert weighted.row(42) == {"tail_radius": 4.5, "tail_log_weight": -3.0}
    assert weighted.row(40) == {"tail_radius": 1.5, "tail_log_weight": -0.25}


@pytest.mark.parametrize(("tail", "memory"), [(False, False), (False, True), (True, False)])
def test_rows_have_the_runs_of_their_own_numbers(monkeypatch, tail, memory):
    """Of the rows 103 and 104 of a chunk that begins at 100, the first of which is no mission."""
    asked, lanes = [], kernels.LANES
    made = object.__new__(Evaluator)
    wanted = SimpleNamespace(error_rad=7e-6) if tail else None
    table = SimpleNamespace(loop="loop", tail=wanted, seed=3)
    made.campaign, made.memory = SimpleNamespace(table=table, realisations=5), {} if memory else None
    made.controller, made._proposal = (lambda cell: f"controller {cell}"), lambda cell: f"proposal {cell}"
    own = SimpleNamespace(row="flown", span="span")
    monkeypatch.setattr(evaluator, "mission_loop", lambda *given: asked.append(given) or own)
    monkeypatch.setattr(evaluator, "LinkFile", str)

    def simulate(row, controller, span, count, **given):
        asked.append((row, controller, span, count, given["first_run"], given["threads"], given["beat"]))
        return "runs"

    def weighted(row, controller, span, by, first, beat):
        asked.append((row, controller, span, by, first, beat))
        return np.arange(lanes) + float(first), -np.arange(lanes) - float(first)

    monkeypatch.setattr(evaluator.ensemble, "simulate", simulate)
    monkeypatch.setattr(evaluator.importance_sampling, "runs", weighted)
    rows = lanes + 2 if tail else 2
    files = ["f0", "f1", "f2", None, "f4", *["f"] * rows]
    mirrors, keys = [f"m{k}" for k in range(len(files))], [f"k{k}" for k in range(len(files))]
    drawn = evaluator._Rows(2, 100, {}, np.ones(len(files)), files, mirrors, keys)
    found = made._simulated(drawn, range(3, 3 + rows), "watch")
    loop = ("f4", "loop", 3, "m3")
    if tail:
        flown = ("flown", "controller 2", "span", "proposal 2")
        assert asked == [loop, (*flown, 103, "watch"), (*flown, 103 + lanes, "watch")]
        assert (found.first_row, found.radius_rad.size, found.log_weight.size) == (103, rows, rows)
        assert found.row(103 + rows - 1) == {"tail_radius": 103.0 + lanes + 1, "tail_log_weight": -(103.0 + lanes + 1)}
        return
    assert found == evaluator.Simulated(103, 5, "runs")
    assert asked == [loop, ("flown", "controller 2", "span", 10, 515, 1, "watch")]
    again = made._simulated(drawn, range(3, 5), "watch")
    assert (again is found) is memory and len(asked) == (2 if memory else 4)
    made._simulated(drawn, range(3, 4), "watch")
    assert len(asked) == (2 if memory else 4), "the rows of a group without a mission are not simulated"
    made.campaign.table.loop = None
    assert made._simulated(drawn, range(4, 5), "watch") is None


def test_a_trace_is_of_the_rows_first_run_once_it_has_settled(monkeypatch):
    made, asked = object.__new__(Evaluator), []
    made.campaign = SimpleNamespace(realisations=4)
    made.controller = lambda cell: f"controller {cell}"
    made._drawn = lambda cell, rows: SimpleNamespace(files=[rows.start], mirrors=["mirror"])
    own = SimpleNamespace(row="flown", span=SimpleNamespace(settle_s=0.5))
    made._loop = lambda file, mirror: asked.append((file, mirror)) or own
    times, numbers = np.array([0.0, 0.25, 0.5, 0.75]), np.arange(8.0).reshape(4, 2)
    whole = SimpleNamespace(time_s=times, error_rad=numbers, drive_v=-numbers)
    monkeypatch.setattr(evaluator.traces, "trace", lambda *given: asked.append(given) or whole)
    found = made.trace(2, 9, lambda: asked.append("beat"))
    assert asked == ["beat", (9, "mirror"), ("flown", "controller 2", own.span, 36)]
    assert (found.cell, found.row, found.output, np.isnan(found.value)) == (2, 9, "", True)
    assert (found.time_s.tolist(), found.error_rad.tolist()) == ([0.5, 0.75], [[4.0, 5.0], [6.0, 7.0]])
    assert found.drive_v.tolist() == [[-4.0, -5.0], [-6.0, -7.0]]


def test_the_first_lost_number_is_told_of_all_outputs_that_have_none():
    made = an_evaluator(lambda *given: ({"a": 1.0, "b": np.inf, "c": np.nan, "d": -np.inf}, None), lambda *given: None)
    made.names = ("a", "b", "c", "d")
    found = made.rows(0, range(10, 15), lambda: None, attempts=3)
    assert {each.reason for each in found.failed} == {"gives inf for b, c, d"}
    assert {each.attempts for each in found.failed} == {3} and np.isnan(found.columns["a"]).all()


def test_each_share_of_a_residual_is_of_its_own_count():
    names = ("COUNT_LOST", "COUNT_SATURATED", "COUNT_CLAMPED", "COUNT_OUTSIDE")
    counters = {getattr(kernels, name): 10.0 + k for k, name in enumerate(names)}
    runs = SimpleNamespace(
        radial_rms_rad=1.5, largest_rad=np.array([2.0, 7.0, 3.0]), beyond=lambda limit: 100.0 * limit,
        quantile_rad=lambda share: 5.0 * share, share=counters.get,
    )  # fmt: skip
    required, table = SimpleNamespace(pointing_error_rad=0.25), SimpleNamespace(quantile=0.75)
    whole = evaluate.controller_study.table
    assert whole(table) is table
    found = {name: of() for name, of in evaluate._residual(required, table, runs).items()}
    assert found == {
        "residual_rms": 1.5, "residual_quantile": 3.75, "residual_largest": 7.0, "beyond_share": 25.0,
        "lost_share": 10.0, "saturated_share": 11.0, "beyond_rate_share": 12.0, "outside_share": 13.0,
    }  # fmt: skip
    counts = np.zeros((2, kernels.BINS), dtype=np.int32)
    counts[0, [0, 2]], counts[1, [2, 5]] = [3, 1], [2, 4]
    shares = evaluate.exceeded(SimpleNamespace(histogram=counts))
    np.testing.assert_allclose(shares[:8], [1.0, 0.7, 0.7, 0.4, 0.4, 0.4, 0.0, 0.0], atol=1e-15)


def test_light_that_cannot_be_is_refused_of_the_link_and_of_each_beam_by_name(monkeypatch):
    data, impossible = SimpleNamespace(requirement="required"), SimpleNamespace(possible=False)
    monkeypatch.setattr(evaluate.Exposure, "stated", lambda of: impossible)
    monkeypatch.setattr(evaluate.Exposure, "of", lambda *given: SimpleNamespace(possible=True, given=given))
    monkeypatch.setattr(evaluate, "stated_outage", lambda required: 0.125)
    with pytest.raises(evaluate.link.LinkError, match=f"^{evaluate.IMPOSSIBLE}$"):
        evaluate._exposure(data, None)
    runs = SimpleNamespace(quantile_rad=lambda share: 8.0 * share, beyond="beyond", histogram=np.eye(3, kernels.BINS))
    at, quantile, beyond, errors = evaluate._exposure(data, runs).given
    assert (at is data, quantile, beyond, errors().share.sum()) == (True, 7.0, "beyond", pytest.approx(1.0))
    monkeypatch.setattr(evaluate.link, "beam_budget", lambda *given: impossible)
    beam = evaluate._Beam("answer", ("a table",), "shared", "beam", {})
    with pytest.raises(evaluate.link.LinkError, match=f"^answer: {evaluate.IMPOSSIBLE}$"):
        evaluate._beam_margin(beam)
    monkeypatch.setattr(evaluate.link, "rate_at_loss", lambda of, margin, loss: 1e6 * margin - loss)
    monkeypatch.setattr(data, "requirement", SimpleNamespace(margin_db=3.0))
    assert evaluate._rate(data, 7.0) == 3e6 - 7.0


# ---------------------------------------------------------------------------------------------- rounds of a campaign
class Kept(dict):
    """A ledger of chunks by cell and number that notes what is noted."""

    path = Path("a b.ledger")

    def __init__(self, *done):
        super().__init__(dict.fromkeys(done, b""))
        self.noted = {}

    def done(self):
        return set(self)

    def note(self, key, value):
        self.noted[key] = value

    def put(self, cell, number, payload):
        self[cell, number] = payload


def rounds_of(book, outcomes, precise=(), rounds=(6, 10)):
    """A runner of three cells with these rounds of rows in chunks of four, and what it tells."""
    made, told = object.__new__(run._Runner), []
    made.campaign = SimpleNamespace(cells=[0, 1, 2], limits=())
    made.plan, made.book, made.pace, made.total = Plan(4, 4, rounds, False), book, run._Pace(8, 30.0), 0
    made.engine = SimpleNamespace(outcomes=outcomes, close=lambda: told.append("closed"))
    made.on_progress = lambda done, total, what: told.append((done, total))
    made._precise = lambda cell, rows: (cell, rows) in precise
    made._traces = lambda: told.append("traces")
    return made, told


def test_rounds_have_the_chunks_that_are_missing_of_the_cells_that_are_not_precise():
    book, asked = Kept((0, 0), (2, 1)), []

    def outcomes(jobs):
        asked.append(list(jobs))
        return (Outcome(job, "done", bytes([job.cell, job.number])) for job in asked[-1])

    made, told = rounds_of(book, outcomes, precise={(0, 6), (1, 10)})
    made.run()
    assert [[(job.cell, job.number) for job in each] for each in asked] == [
        [(0, 1), (1, 0), (1, 1), (2, 0)],
        [(1, 2), (2, 2)],
    ]
    assert told == [(12, 24), (16, 24), (20, 24), (24, 24), (26, 28), (28, 28), "traces"]
    assert book[1, 2] == b"\x01\x02" and book.noted["state"] == "complete" and book.noted["seconds"] >= 30.0


@pytest.mark.parametrize(
    ("error", "kind", "words", "state"),
    [
        (CampaignError("the disk is full"), CampaignError, "the disk is full; 8 rows are in", "stopped"),
        (CampaignError("x: `microrad campaign resume x`"), CampaignError, "x: `microrad campaign resume x`", "stopped"),
        (KeyboardInterrupt(), KeyboardInterrupt, "stopped; 8 rows are in", "running"),
        (ZeroDivisionError("odd"), ZeroDivisionError, "odd", "stopped"),
    ],
)
def test_a_stop_says_what_is_in_and_how_to_go_on_once(error, kind, words, state):
    def outcomes(jobs):
        raise error

    book = Kept((0, 0))
    made, told = rounds_of(book, outcomes)
    with pytest.raises(kind) as caught:
        made.run()
    on = " a b.ledger. Go on with: microrad campaign resume 'a b.ledger'" if "rows are in" in words else ""
    assert str(caught.value) == words + on
    assert (book.noted["state"], told) == (state, ["closed"])


@pytest.mark.parametrize(
    ("cells", "rows", "took_s", "mean_s", "asked"),
    [
        (2, 3, 0.25, 0.25, [(0, 0), (1, 0), (0, 1), (1, 1), (0, 2), (1, 2)]),
        (1, 1, 0.25, 0.25, [(0, 0), (0, 0)]),
        (1, 9, 100.0, 100.0, [(0, 0), (0, 1)]),
    ],
)
def test_a_row_is_timed_by_rows_of_all_cells_in_turn_but_for_the_first(monkeypatch, cells, rows, took_s, mean_s, asked):
    done, now = [], [50.0]

    def work(cell, of, beat, attempts):
        assert (len(of), attempts) == (1, 1)
        done.append((cell, of.start))
        now[0] += took_s if len(done) > 1 else 1000.0

    monkeypatch.setattr(run, "_TIMED_S", 30.0)
    monkeypatch.setattr(run, "Evaluator", lambda campaign, controllers: SimpleNamespace(rows=work))
    campaign = SimpleNamespace(cells=[0] * cells, rows=rows)
    assert run.row_s(campaign, lambda: now[0]) == pytest.approx(mean_s)
    assert done == asked


def test_a_ledgers_head_has_the_units_and_meanings_of_all_columns(monkeypatch):
    monkeypatch.setattr(run.bundle, "hashes", lambda campaign: {"code": "c0de"})
    inputs = [SimpleNamespace(key="a.power", unit="W"), SimpleNamespace(key="b.angle", unit="rad")]
    outputs = [
        SimpleNamespace(name=n, unit=u, meaning=m) for n, u, m in (("margin", "dB", "left"), ("outage", "", "part"))
    ]
    campaign = SimpleNamespace(
        path=Path("x/second.toml"), text="the text", mission=SimpleNamespace(mission=SimpleNamespace(name="a mission")),
        table=SimpleNamespace(seed=41), cells=[SimpleNamespace(values={"k": "1"}), SimpleNamespace(values={"k": "2"})],
        inputs=inputs, outputs=outputs,
    )  # fmt: skip
    head = run._head(campaign, b"spec")
    assert [tuple(each) for each in head.columns] == [
        ("row", "", "number of the row in its cell"), ("weight", "", "weight of the row"), ("a.power", "W", "drawn"),
        ("b.angle", "rad", "drawn"), ("margin", "dB", "left"), ("outage", "", "part"),
    ]  # fmt: skip
    assert (head.campaign_name, head.campaign_text, head.mission_name) == ("second", "the text", "a mission")
    assert (head.seed, head.hashes, head.cells, head.bundle) == (
        41,
        {"code": "c0de"},
        ({"k": "1"}, {"k": "2"}),
        b"spec",
    )
    assert head.versions["microrad"] == microrad.__version__ and set(head.versions) > {"numpy", "scipy"}


def test_controllers_are_tuned_once_for_each_loop_by_the_values_that_it_has(monkeypatch):
    tuned, told = [], []

    def mission_loop(file, table, seed):
        def tune():
            if "bad" in file:
                raise ValueError("no stable loop")
            tuned.append((file, table, seed))
            return f"tuned {file}"

        return SimpleNamespace(tuned=tune)

    builder = SimpleNamespace(
        loop_key=lambda cell, values: (cell % 2, values.get("loop")), mission=lambda cell, values: f"{cell} {values}"
    )
    monkeypatch.setattr(loops, "MissionBuilder", lambda campaign: builder)
    monkeypatch.setattr(loops, "mission_loop", mission_loop)
    table = SimpleNamespace(controller="PI + notch", duration_s=None, settle_s=0.25)
    campaign = SimpleNamespace(table=SimpleNamespace(loop=table, seed=41), cells=[0, 0, 0])
    assert loops.controllers(campaign, lambda *each: told.append(each)) == ("tuned 0 {}", "tuned 1 {}", "tuned 0 {}")
    assert told == [(k, 3, "tuning PI + notch") for k in range(3)]
    assert tuned == [(f"{k} {{}}", table, 41) for k in range(2)]
    tuner = loops.ControllerTuner(campaign)
    made = [tuner.tuned(0, {"loop": 1.0, "link": 2.0}), tuner.tuned(0, {"loop": 1.0}), tuner.tuned(0, {"loop": 2.0})]
    assert made == ["tuned 0 {'loop': 1.0, 'link': 2.0}"] * 2 + ["tuned 0 {'loop': 2.0}"]
    with pytest.raises(CampaignError, match=r"^the controller 'PI \+ notch' cannot be tuned: no stable loop$"):
        tuner.tuned(0, {"loop": "bad"})
    f = SimpleNamespace(duration_s=3.0, settle_s=0.5)
    assert loops.span(table, f, 41) == loops.Span(3.0, 0.25, 41)
    assert loops.span(SimpleNamespace(duration_s=2.0, settle_s=None), f, 41) == loops.Span(2.0, 0.5, 41)
    campaign.table.loop = None
    assert loops.controllers(campaign, None) == ()


@pytest.mark.parametrize(
    ("varies", "own", "duration_s", "rows", "chunk"),
    [
        (True, 3, 1.0, 1024, 32),  # of 20 million steps 62.5 rows, each a batch of 64 runs of 5000
        (True, 200, 1.0, 1024, 8),  # four batches each: 15.6 rows
        (False, 3, 0.25, 1024, 1024),  # as many as there may be
        (False, 3, 0.25, 100, 64),  # as there are
        (False, 3, 1e6, 1024, 32),  # 22 rows fill a batch
    ],
)
def test_a_chunk_of_a_loop_is_a_second_of_steps_and_whole_batches(monkeypatch, varies, own, duration_s, rows, chunk):
    f = SimpleNamespace(plant_step_s=2e-4, settle_s=0.0, duration_s=duration_s)
    monkeypatch.setattr(rows_plan.loops, "settings", lambda mission: f)
    table = SimpleNamespace(loop=SimpleNamespace(duration_s=None, settle_s=None), seed=1, precision=None)
    outputs = [SimpleNamespace(group="residual")]
    given = {"mission": None, "chunk_rows": None, "block": 32, "outputs": outputs, "rows": rows}
    campaign = SimpleNamespace(table=table, loop_varies=varies, realisations=own, **given)
    assert planned(campaign) == Plan(chunk, chunk, (rows,), False)
    assert planned(SimpleNamespace(**{**vars(campaign), "chunk_rows": 4})) == Plan(4, chunk, (rows,), False)
    outputs.append(SimpleNamespace(group="day"))
    assert planned(campaign) == Plan(8, 8, (rows,), False)
    table.loop = None
    assert planned(campaign) == Plan(8, 8, (rows,), False)
    outputs.pop()
    assert planned(campaign) == Plan(*[1 << rows.bit_length() - 1] * 2, (rows,), True)


# ------------------------------------------------------------------------------------------------- what a worker does
@pytest.mark.parametrize("looped", [False, True])
def test_a_worker_does_chunks_rows_and_traces_by_the_numbers_of_their_job(monkeypatch, looped):
    asked, table = [], SimpleNamespace(loop="a loop" if looped else None)
    campaign = SimpleNamespace(table=table, mission="a mission")

    class Rows:
        def __init__(self, *given):
            asked.append(given)

        def rows(self, cell, rows, beat, attempts=2, number=0):
            return cell, rows, beat, attempts, number

        def trace(self, *given):
            return given

        def controller(self, cell):
            return f"of cell {cell}"

    loop = SimpleNamespace(timing=SimpleNamespace(period_s=0.25))
    opened = SimpleNamespace(campaign=campaign, controllers=("first", "second"))
    for name, fake in {
        "opened": lambda spec: asked.append(spec) or opened,
        "planned": lambda of: Plan(4, 4, (10,), of is not campaign),
        "Evaluator": Rows,
        "mission_loop": lambda *given: asked.append(given) or SimpleNamespace(row=loop),
    }.items():
        monkeypatch.setattr(work, name, fake)
    monkeypatch.setattr(work.traces, "trace", lambda *given: asked.append(given))
    monkeypatch.setattr(work.chunk_format, "pack_chunk", lambda of: ("chunk", *of))
    monkeypatch.setattr(work.chunk_format, "pack_trace", lambda of: ("trace", *of))
    made = work.Work(b"a spec")
    first = [b"a spec", (campaign, {0: "first", 1: "second"})]
    span = loops.Span(0.5, 0.0, 0)
    assert asked == first + [("a mission", "a loop", 0), (loop, "of cell 0", span)] * looped
    assert made.do(records.Job(3, 2), "beat") == ("chunk", 3, range(8, 10), "beat", 2, 2)
    assert made.do(records.Job(3, 1, 7, "row"), "beat") == ("chunk", 3, range(7, 8), "beat", 1, 1)
    assert made.do(records.Job(3, 1, 7, "trace"), "beat") == ("trace", 3, 7, "beat")


@pytest.mark.parametrize(
    ("means", "kind", "processes"),
    [
        ({}, "local", 5),
        ({"threads": 3}, "local", 3),
        ({"workers": 2}, "local", 2),
        ({"scheduler": "tcp://there", "workers": 2}, "dask", "tcp://there"),
        ({"scheduler": ""}, "dask", ""),
    ],
)
def test_means_are_given_the_work_and_how_long_a_job_may_be_silent(monkeypatch, means, kind, processes):
    monkeypatch.setattr(run.os, "cpu_count", lambda: 5)
    monkeypatch.setattr(run, "LocalEngine", lambda *given: ("local", *given))
    monkeypatch.setattr(run, "DaskEngine", lambda *given: ("dask", *given))
    assert run.Means(**means).engine(b"s", 2.5) == (kind, b"s", "microrad.campaign.work:Work", processes, 2.5)
    monkeypatch.setattr(run.os, "cpu_count", lambda: None)
    assert run.Means().engine(b"s", 2.5)[3] == 1


@pytest.mark.parametrize(
    ("done", "here", "began_s", "now_s", "total", "shown", "words"),
    [
        (0, 0, 0.0, 9.0, 10, "margin 1 %: 2 dB", "rows"),
        (4, 4, 9.0, 9.0, 10, "margin 1 %: 2 dB", "rows"),
        (30, 10, 5.0, 9.0, 40, "", "2.5 rows/s, 4 s left"),
        (30, 10, 5.0, 9.0, 30, "margin 1 %: 2 dB", "2.5 rows/s, 0 s left, margin 1 %: 2 dB"),
        (1000, 4, 1.0, 9.0, 100000, "", "0.5 rows/s, 55.0 h left"),
        (100, 80, 8.0, 9.0, 19300, "", "80 rows/s, 4 min left"),
    ],
)
def test_the_pace_of_a_sitting_is_that_of_its_own_rows(monkeypatch, done, here, began_s, now_s, total, shown, words):
    monkeypatch.setattr(run.time, "monotonic", lambda: now_s)
    pace = run._Pace(done, 100.0, began_s, here)
    assert pace.words(total, shown) == words
    assert pace.seconds == 100.0 + now_s - began_s


def test_a_campaign_is_begun_with_its_work_in_chunks_that_were_timed_and_resumed_as_it_was_begun(monkeypatch, tmp_path):
    asked, file = [], tmp_path / "campaign.toml"
    file.write_text("", encoding="utf-8")

    @dataclass(frozen=True)
    class File:
        table: object
        chunk_rows: int | None = None

    campaign = File(SimpleNamespace(row_limit_s=70.0))
    plan = SimpleNamespace(is_timed=True, timed_chunk=lambda row_s: int(8 * row_s))
    book = SimpleNamespace(
        head=SimpleNamespace(bundle=b"kept", hashes={"code": "x"}), notes=lambda: {"file": str(file)}
    )
    ledgers = SimpleNamespace(
        create=lambda *given: asked.append(("create", *given)) or nullcontext(book),
        open=lambda path, write: asked.append(("open", path, write)) or nullcontext(book),
    )
    engine = lambda spec, late_s: asked.append((spec, late_s)) or SimpleNamespace(close=lambda: asked.append("closed"))  # noqa: E731
    runner = lambda *given: SimpleNamespace(run=lambda: asked.append(("run", given[0], given[2], given[3])))  # noqa: E731
    for name, fake in {
        "load_campaign": lambda path: asked.append(("load", path)) or campaign,
        "planned": lambda of: plan,
        "row_s": lambda of: 0.5,
        "controllers": lambda of, on_progress: asked.append(("tune", of.chunk_rows, on_progress)) or "tuned",
        "refuse_existing": lambda path: asked.append(("refuse", path)),
        "_head": lambda of, spec: ("head", of.chunk_rows, spec),
        "_Runner": runner,
        "Ledger": ledgers,
        "sweep_scratch": lambda name: asked.append(("sweep", name)),
        "check_same": lambda *given: asked.append(("same", *given)),
        "verify": lambda path: SimpleNamespace(sound=path.name == "sound"),
        "mend": lambda path: asked.append(("mend", path)),
    }.items():
        monkeypatch.setattr(run, name, fake)
    opened = SimpleNamespace(campaign=File(SimpleNamespace(row_limit_s=5.0), 2))
    monkeypatch.setattr(run.bundle, "packed", lambda of, tuned: ("packed", of.chunk_rows, tuned))
    monkeypatch.setattr(run.bundle, "opened", lambda spec, any_code: asked.append((spec, any_code)) or opened)
    monkeypatch.setattr(run.bundle, "hashes", lambda of: {"of": of.chunk_rows})
    path, means = tmp_path / "book", SimpleNamespace(engine=engine)
    spec, timed = ("packed", 4, "tuned"), replace(campaign, chunk_rows=4)
    run.run_campaign(file, path, means, "told")
    assert [each for each in asked if each[0] not in ("refuse", "load")] == [
        ("tune", 4, "told"),
        (spec, 100.0),
        ("create", path, ("head", 4, spec), {"file": str(file.resolve())}),
        ("run", timed, book, "told"),
        "closed",
        ("sweep", "campaign"),
    ]
    assert ("refuse", path) in asked and ("load", file) in asked
    for name, here in (("sound", True), ("damaged", False)):
        asked.clear()
        if not here:
            file.unlink()
        path = tmp_path / name
        run.resume_campaign(path, means, "told")
        assert asked == [
            *([] if here else [("mend", path)]),
            ("open", path, True),
            (b"kept", True),
            *([("load", file)] if here else []),
            ("same", {"code": "x"}, {"of": None if here else 2}, path),
            (b"kept", 35.0),
            ("run", opened.campaign, book, "told"),
            "closed",
            ("sweep", "campaign"),
        ]


def test_rows_of_an_evaluator_have_their_columns_failures_and_curves_whichever_group_they_were_in(monkeypatch):
    """Rows 10 to 14: 10 and 11 share a loop; 12 fails once, 13 always."""
    monkeypatch.setattr(rows_evaluator.kernels, "BINS", 2)
    made = object.__new__(Evaluator)
    table = SimpleNamespace(row_limit_s=9.0, seed=41, loop=object(), tail=None)
    made.campaign, made.names = SimpleNamespace(table=table), ("margin", "outage")
    columns = {"power": np.arange(5.0) + 0.5}
    drawn = SimpleNamespace(
        weight=np.array([1.0, 2.0, 0.5, 4.0, 8.0]), columns=columns, files=[0] * 5, keys=list("aabca")
    )
    made._drawn = lambda cell, rows: drawn
    tried = []

    def evaluate(of, group, watch, kept, exceeded):
        tried.append(list(group))
        lost = {i: f"lost {len(tried)}" for i in group if i == 3 or (i == 2 and len(tried) == 2)}
        for i in group:
            if i not in lost:
                kept["margin"][i], kept["outage"][i] = 10.0 * i, 0.125 * i
                exceeded[i] = np.array([1.0, 0.25 * i])
        return lost

    made._evaluate = evaluate
    found = made.rows(3, range(10, 15), None, number=7)
    assert tried == [[0, 1], [2], [2], [3], [3], [4]]
    assert (found.cell, found.number, list(found.columns)) == (3, 7, ["row", "weight", "power", "margin", "outage"])
    assert [each.tolist() for each in found.columns.values()][:3] == [
        [10.0, 11.0, 12.0, 13.0, 14.0],
        [1.0, 2.0, 0.5, 4.0, 8.0],
        [0.5, 1.5, 2.5, 3.5, 4.5],
    ]
    np.testing.assert_array_equal(found.columns["margin"], [0.0, 10.0, 20.0, math.nan, 40.0])
    np.testing.assert_array_equal(found.columns["outage"], [0.0, 0.125, 0.25, math.nan, 0.5])
    assert [(f.row, f.seed, f.attempts, f.reason) for f in found.failed] == [(13, 41, 2, "lost 5")]
    assert (found.survival.tolist(), found.survival_square.tolist()) == ([4.0, 1.75], [4.0, 1.3125])
    tried.clear()
    once = made.rows(3, range(10, 15), None, attempts=1)
    assert [(f.row, f.attempts, f.reason) for f in once.failed] == [(12, 1, "lost 2"), (13, 1, "lost 3")]
    assert (once.number, tried) == (0, [[0, 1], [2], [3], [4]])
    table.loop = None
    tried.clear()
    assert (made.rows(3, range(10, 15), None).survival.size, tried[0], tried[-1]) == (0, [0], [4])


def test_joined_chunks_have_the_number_of_the_first_and_the_failures_of_all():
    def chunk(number, rows, failed, curve):
        columns = {"row": np.array(rows), "margin": 2.0 * np.array(rows)}
        lost = tuple(records.Failed(row, 1, 2, f"of {row}") for row in failed)
        return records.Chunk(4, number, columns, lost, np.array(curve), 3.0 * np.array(curve))

    found = records.joined(
        [chunk(6, [8.0], [8], []), chunk(2, [3.0, 5.0], [], [1.0, 0.5]), chunk(9, [7.0], [7], [0.5, 2.0])]
    )
    assert (found.cell, found.number, [each.row for each in found.failed]) == (4, 6, [8, 7])
    assert {name: each.tolist() for name, each in found.columns.items()} == {
        "row": [8.0, 3.0, 5.0, 7.0],
        "margin": [16.0, 6.0, 10.0, 14.0],
    }
    assert (found.survival.tolist(), found.survival_square.tolist()) == ([1.5, 2.5], [4.5, 7.5])
    bare = records.joined([chunk(6, [8.0], [8], [])] * 2)
    assert (bare.survival.size, bare.survival_square.size, len(bare.failed)) == (0, 0, 2)


@pytest.mark.parametrize(
    ("values", "label"),
    [({}, ""), ({"a": "5 cm"}, "a = 5 cm"), ({"b": "1", "a": "[2, true]"}, "b = 1, a = [2, true]")],
)
def test_a_cell_is_told_by_the_values_of_its_grid_in_their_order(values, label):
    assert records.CellSummary(values, 0, 0, {}, None, {}, None).label == label


@pytest.mark.parametrize(("least", "most", "is_least"), [(3.0, None, True), (None, 3.0, False), (0.0, 9.0, True)])
def test_the_worst_of_a_limit_with_a_least_is_the_least_be_it_0(least, most, is_least):
    assert records.Limit("margin", least, most, "").worst_is_least is is_least


@pytest.mark.parametrize("looped", [False, True])
def test_each_output_of_a_row_comes_from_its_own_part_of_the_mission(monkeypatch, looped):
    asked = []
    requirement = SimpleNamespace(margin_db=3.0, pointing_error_rad=2e-5)
    given = {"requirement": requirement, "beacon": "a beacon", "answer": "an answer", "fine_pointing": "fine"}
    m = load_mission(SHIPPED).mission.model_copy(update=given)
    file = SimpleNamespace(mission=m, sources="sources")
    under = SimpleNamespace(margin_db=4.5, outage_loss_db=7.0, short_of=lambda margin: 0.125 + margin)
    fakes = {
        "_exposure": lambda data, runs: asked.append(("exposure", data, runs)) or under,
        "_day": lambda of, exposure: (
            asked.append(("day", of is file)) or SimpleNamespace(capacity_bit=8e9, contact_s=600.0)
        ),
        "_margin_under_fades": lambda of, data: {"data": 2.5}[data],
        "_rate": lambda data, loss: 1e6 * loss,
        "_optical_bit": lambda of: 9e9,
        "_beam_margin": lambda of: {("beacon", "shared", "a beacon", "sources"): 1.5}.get(of, 1.75),
    }
    for name, fake in fakes.items():
        monkeypatch.setattr(evaluate, name, fake)
    monkeypatch.setattr(evaluate.link, "of", lambda of: asked.append("link") or "data")
    monkeypatch.setattr(evaluate.link, "Shared", SimpleNamespace(of=lambda of: "shared"))
    monkeypatch.setattr(evaluate._Beam, "of", lambda *of: of)
    monkeypatch.setattr(evaluate.controller_study, "table", lambda of: SimpleNamespace(quantile={"fine": 0.75}[of]))
    counts = {
        kernels.COUNT_LOST: 0.1, kernels.COUNT_SATURATED: 0.2, kernels.COUNT_CLAMPED: 0.3, kernels.COUNT_OUTSIDE: 0.4
    }  # fmt: skip
    runs = SimpleNamespace(
        radial_rms_rad=1e-6, largest_rad=np.array([3e-6, 5e-6, 4e-6]), quantile_rad=lambda share: 1e-6 * share,
        beyond=lambda radius: 1e3 * radius, share=counts.get,
    )  # fmt: skip
    of_links = {
        "margin": 4.5, "margin_under_fades": 2.5, "outage": 0.125, "short": 3.125, "data_rate": 7e6,
        "beacon_margin": 1.5, "answer_margin": 1.75, "volume": 8e9, "contact_time": 600.0, "optical_volume": 9e9,
    }  # fmt: skip
    of_loops = {
        "residual_rms": 1e-6, "residual_quantile": 0.75e-6, "residual_largest": 5e-6, "beyond_share": 0.02,
        "lost_share": 0.1, "saturated_share": 0.2, "beyond_rate_share": 0.3, "outside_share": 0.4,
    }  # fmt: skip
    wanted = of_loops | of_links if looped else of_links
    found = evaluate.outputs(file, runs if looped else None, wanted)
    assert (list(found), found) == (list(wanted), pytest.approx(wanted))
    assert asked == ["link", ("exposure", "data", runs if looped else None), ("day", True)], "each part once"
    asked.clear()
    assert evaluate.outputs(file, None, ("answer_margin", "beacon_margin")) == {
        "beacon_margin": 1.5,
        "answer_margin": 1.75,
    }
    assert asked == [], "nothing is computed for any other"


def test_a_link_that_no_rate_closes_carries_nothing(monkeypatch):
    def none(*given):
        raise evaluate.link.LinkError("no rate has that margin")

    monkeypatch.setattr(evaluate.link, "rate_at_loss", none)
    assert evaluate._rate(SimpleNamespace(requirement=SimpleNamespace(margin_db=3.0)), 1.0) == 0.0


def test_the_day_of_a_row_is_taken_under_its_own_pointing(monkeypatch):
    from microrad.link import study as link_study
    from microrad.orbit import day as day_study

    file = SimpleNamespace(path=Path("there/m.toml"), sources="sources")
    monkeypatch.setattr(link_study, "run_link_study", lambda of: ("links", of))
    monkeypatch.setattr(day_study, "relay", lambda *given: given)
    monkeypatch.setattr(day_study, "optical_alone", lambda of: SimpleNamespace(capacity_bit={file.path: 7e9}[of.path]))
    under = SimpleNamespace(outage_loss_db=2.5, short_of=lambda margin: 0.25 + margin)
    links, loss = evaluate._day(file, under)
    assert (links, loss) == (("links", file), day_study.PointingLoss(2.5, 0.25, "campaign"))
    assert evaluate._optical_bit(file) == 7e9
    asked = []
    monkeypatch.setattr(
        evaluate, "fading_of", lambda *given: asked.append(given) or SimpleNamespace(margin_left_db=-1.25)
    )
    assert (evaluate._margin_under_fades(file, "data"), asked) == (-1.25, [("data", Path("there"), "sources")])


@pytest.mark.parametrize("sky", [None, "a sky"])
def test_a_beam_is_the_same_by_its_tables_and_what_it_passes_through(sky):
    shared = SimpleNamespace(sky=sky, outage=0.125, point_ahead_rad=2e-5, terminals="both", conventions="ours")
    beam = evaluate._Beam.of("beacon", shared, "a table", {"a": 1})
    air = None if sky is None else (sky, 0.125)
    assert (beam.name, beam.tables) == ("beacon", ("a table", 2e-5, "both", "ours", air))
    assert (beam.shared, beam.beam, beam.sources) == (shared, "a table", {"a": 1})
    other = SimpleNamespace(**{**vars(shared), "unread": 3})
    assert beam == evaluate._Beam.of("beacon", other, "a table", {}) and hash(beam) == hash(
        evaluate._Beam.of("beacon", other, "a table", {})
    )
    assert beam != evaluate._Beam.of("answer", shared, "a table", {"a": 1})
    assert beam != evaluate._Beam.of(
        "beacon", SimpleNamespace(**{**vars(shared), "point_ahead_rad": 0.0}), "a table", {}
    )


def test_the_time_of_this_sitting_is_noted_when_it_ends():
    """Thirty seconds of earlier ones, and a second since this one began."""
    book = Kept()
    made, _ = rounds_of(book, lambda jobs: iter(()))
    made.pace.began_s -= 1.0
    made._note("stopped")
    assert book.noted["seconds"] >= 31.0 and book.noted["state"] == "stopped"


@pytest.mark.parametrize("noted", [{}, {"file": "gone.toml"}, {"file": "."}])
def test_a_campaign_whose_file_is_not_there_goes_on_with_the_one_in_its_ledger(monkeypatch, tmp_path, noted):
    """Nothing was noted, the file is gone, or a folder has its name by now."""
    monkeypatch.chdir(tmp_path)
    kept, asked = SimpleNamespace(table=SimpleNamespace(row_limit_s=5.0)), []
    book = SimpleNamespace(head=SimpleNamespace(bundle=b"kept", hashes={"code": "x"}), notes=lambda: noted)
    for name, fake in {
        "verify": lambda path: SimpleNamespace(sound=True),
        "Ledger": SimpleNamespace(open=lambda path, write: nullcontext(book)),
        "load_campaign": asked.append,
        "check_same": lambda *given: asked.append(given),
        "_Runner": lambda *given: SimpleNamespace(run=lambda: asked.append(given[0])),
        "sweep_scratch": lambda name: None,
    }.items():
        monkeypatch.setattr(run, name, fake)
    monkeypatch.setattr(run.bundle, "opened", lambda spec, any_code: SimpleNamespace(campaign=kept))
    monkeypatch.setattr(run.bundle, "hashes", lambda of: {"of": of})
    means = SimpleNamespace(engine=lambda spec, late_s: SimpleNamespace(close=lambda: None))
    run.resume_campaign(tmp_path / "a.ledger", means)
    assert asked == [({"code": "x"}, {"of": kept}, tmp_path / "a.ledger"), kept]


def test_each_cell_has_a_controller_and_a_proposal_of_its_own_mission_with_what_all_rows_have(monkeypatch):
    """Both are made once for each cell, in whatever order the cells are asked for."""
    made, asked = object.__new__(Evaluator), []
    made.fixed, made.controllers = {"power": 2.5}, {0: "tuned 0", 1: "tuned 1"}
    made._cell_controllers, made._proposals = {}, {}
    made.campaign = SimpleNamespace(table=SimpleNamespace(tail=SimpleNamespace(error_rad=7e-6)))
    made.builder = SimpleNamespace(mission=lambda cell, values: f"mission {cell} {values}")
    made._loop = lambda file: SimpleNamespace(
        controller=lambda tuned: f"{tuned} on {file}", row=f"row of {file}", span=f"span of {file}"
    )
    monkeypatch.setattr(evaluator.importance_sampling, "proposal", lambda *given: asked.append(given) or given)
    own = [f"mission {cell} {{'power': 2.5}}" for cell in (0, 1)]
    for cell in (1, 0, 1):
        controller = f"tuned {cell} on {own[cell]}"
        wanted = (f"row of {own[cell]}", controller, f"span of {own[cell]}", 7e-6)
        assert made._proposal(cell) == wanted and made.controller(cell) == controller
        assert made._proposal(cell) is made._proposal(cell)
    assert len(asked) == 2


def test_rows_are_drawn_with_what_all_have_and_each_keeps_its_mission_mirror_and_loop(monkeypatch):
    """Of three rows from 40 on the second is no mission; its mirror and its loop are known all the same."""
    made, asked = object.__new__(Evaluator), []
    made.campaign, made.fixed = "campaign", {"aperture": 0.5}
    columns, weight = (
        {"power": np.array([1.0, 2.0, 4.0]), "loss": np.array([8.0, 16.0, 32.0])},
        np.array([1.0, 0.5, 2.0]),
    )
    monkeypatch.setattr(evaluator.sampling, "rows", lambda *given: asked.append(given) or (columns, weight))

    def mission(cell, values):
        if values["power"] == 2.0:
            raise CampaignError(f"no mission of cell {cell}")
        return f"mission {cell} {values}"

    made.builder = SimpleNamespace(
        mission=mission,
        several_axes=lambda cell, values: f"mirror {cell} {values['loss']}",
        loop_key=lambda cell, values: (cell, *values.items()),
    )
    found = made._drawn(3, range(40, 43))
    assert asked == [("campaign", 3, 40, 3)]
    assert (found.cell, found.first, found.columns, found.weight) == (3, 40, columns, weight)
    values = [{"aperture": 0.5, "power": p, "loss": 8.0 * p} for p in (1.0, 2.0, 4.0)]
    assert found.files == [f"mission 3 {values[0]}", "no mission of cell 3", f"mission 3 {values[2]}"]
    assert found.mirrors == ["mirror 3 8.0", "mirror 3 16.0", "mirror 3 32.0"]
    assert found.keys == [(3, *each.items()) for each in values]


def test_traces_of_one_row_of_two_cells_have_each_the_value_of_their_own():
    """They come in any order, and a value may be 0."""
    made, put = a_runner(), []
    made._worst = lambda cell: [(3, 1.0), (5, 0.0)] if cell == 0 else [(5, 4.0), (3, -2.0)]
    made.book = SimpleNamespace(traces=lambda: (), drop_trace=None, put_trace=put.append)

    def outcomes(jobs):
        for job in reversed(jobs):
            found = records.WorstTrace(job.cell, job.row, "", np.nan, np.zeros(1), np.zeros((1, 1)), np.zeros((1, 1)))
            yield Outcome(job, "done", chunk_format.pack_trace(found))

    made._outcomes = outcomes
    made._traces()
    told = [(each.cell, each.row, each.output, each.value) for each in put]
    assert told == [(1, 3, "margin", -2.0), (1, 5, "margin", 4.0), (0, 5, "margin", 0.0), (0, 3, "margin", 1.0)]


def test_a_row_by_itself_has_its_last_result_whether_its_worker_died_before_or_after(monkeypatch):
    """Of one that had a result without numbers and then none at all, the result counts, and its reason."""
    made, kept, told = a_runner(), [], {4: "dd", 5: "dn", 6: "fd", 7: "n"}

    def outcomes(jobs):
        for job in jobs:
            now, told[job.row] = told[job.row][0], told[job.row][1:]
            lost = (records.Failed(job.row, 7, 1, f"no number of {job.row}"),) if now == "f" else ()
            value = np.nan if lost else 10.0 + job.row
            chunk = replace(a_chunk(1, [job.row], [value], cell=1), failed=lost)
            if now == "d":
                yield Outcome(job, "died", reason=f"ended at {job.row}, {len(told[job.row])} to go")
            else:
                yield Outcome(job, "done", chunk_format.pack_chunk(chunk))

    drawn = []
    monkeypatch.setattr(run.sampling, "rows", lambda campaign, *of: (drawn.append(of), ({}, np.array([0.5])))[1])
    made.campaign.outputs = [SimpleNamespace(name="margin")]
    made._outcomes = outcomes
    made._keep = lambda job, payload: kept.append(chunk_format.unpack_chunk(payload))
    made._by_rows(records.Job(1, 1))
    (chunk,) = kept
    assert (chunk.cell, chunk.number, chunk.columns["row"].tolist()) == (1, 1, [4.0, 5.0, 6.0, 7.0])
    np.testing.assert_array_equal(chunk.columns["margin"], [np.nan, 15.0, np.nan, 17.0])
    assert chunk.columns["weight"].tolist() == [0.5, 1.0, 1.0, 1.0]
    assert drawn == [(1, 4, 1)]
    assert [(each.row, each.attempts, each.reason) for each in chunk.failed] == [
        (4, 2, "ended at 4, 0 to go"), (6, 2, "no number of 6"),
    ]  # fmt: skip
    assert told == {4: "", 5: "", 6: "", 7: ""}


@pytest.mark.parametrize("raised", [None, ValueError, KeyboardInterrupt])
@pytest.mark.parametrize("broken", [False, True])
def test_what_workers_left_is_swept_when_their_engine_is_closed_however_that_ends(monkeypatch, raised, broken):
    """Also where the engine cannot be closed; the error of the work, or of the closing, comes out."""
    done = []

    class Engine:
        def close(self):
            done.append("close")
            if broken:
                raise OSError("no end")

    monkeypatch.setattr(run, "sweep_scratch", done.append)
    engine, error = Engine(), OSError if broken else raised

    def used():
        with run._closing(engine) as given:
            assert (given is engine, done) == (True, [])
            if raised is not None:
                raise raised("stop")

    if error is None:
        used()
    else:
        with pytest.raises(error):
            used()
    assert done == ["close", "campaign"]
