"""The commands `microrad campaign`: what they print, write, refuse and return, for careful and for hasty users."""

import json
import re
import shutil
import socket
import sqlite3
import subprocess
import sys
from contextlib import closing, contextmanager
from pathlib import Path
from types import SimpleNamespace

import pytest

from campaign_files import HEAD, POWER, written
from command_line import listing
from microrad.campaign import run
from microrad.campaign.file import load_campaign
from microrad.campaign.ledger import Ledger, mending
from microrad.campaign.records import CampaignError
from microrad.cli import campaign as cli_campaign
from microrad.cli.campaign import campaigns
from microrad.cli.frame import Outcome, Refusal
from small_campaign import Here, without_worker
from waiting import no_hang

LIMIT = '[limits.margin]\nleast = "1 dB"\n'
LINKS = HEAD.replace("256", "64") + POWER + LIMIT  # without a loop: a worker has its rows in milliseconds
OPTIMISE = """
[optimise]
minimise = "terminals.leo_aperture"
confidence = 0.9
rows = 32
evaluations = 30
[optimise.variables."terminals.leo_aperture"]
low = "{low}"
high = "{high}"
"""


def numbers(data):
    """Every number of a JSON document."""
    if isinstance(data, dict | list):
        return [n for each in (data.values() if isinstance(data, dict) else data) for n in numbers(each)]
    return [data] if isinstance(data, int | float) else []


def parsed(text):
    """A JSON document without what JSON does not know."""

    def refuse(word):
        raise AssertionError(word)

    return json.loads(text, parse_constant=refuse)


@pytest.fixture(scope="module")
def done(tmp_path_factory):
    """A folder with a campaign that has been run."""
    folder = tmp_path_factory.mktemp("a done one")
    with pytest.MonkeyPatch.context() as patch:
        without_worker(patch)
        run.run_campaign(written(folder, LINKS, whole=False), folder / "campaign.ledger", run.Means(threads=1))
    (folder / "campaign.ledger.lock").unlink()
    return folder


@pytest.fixture
def there(folder, done):
    """The current folder with that campaign in it."""
    shutil.copytree(done, folder, dirs_exist_ok=True)
    return folder


def shortened(folder):
    """Take one chunk out of the ledger, as if the campaign had been killed before it."""
    with Ledger.open(folder / "campaign.ledger", write=True) as book:
        book._connection.execute("DELETE FROM chunks WHERE cell = ? AND number = ?", max(book.done()))
        book.note("state", "running")


def broken(folder):
    """Flip one bit in the payload of a chunk."""
    with sqlite3.connect(folder / "campaign.ledger") as book:
        (payload,) = book.execute("SELECT payload FROM chunks").fetchone()
        book.execute("UPDATE chunks SET payload = ?", (payload[:-1] + bytes([payload[-1] ^ 1]),))
    book.close()


# --------------------------------------------------------------------------------------------------------------- help
def test_every_command_has_an_example_that_names_it(call):
    names = [each.name or each.callback.__name__ for each in campaigns.registered_commands]
    assert set(names) == {"init", "run", "resume", "status", "verify", "export", "report", "optimise"}
    for name in names:
        shown = call("campaign", name, "--help")
        assert shown.code == 0 and f"Examples:\n    microrad campaign {name}" in shown.out, name
    assert "microrad campaign init" in call("campaign", "--help").out


# --------------------------------------------------------------------------------------------------------------- init
@pytest.mark.promise("readme-12")
@pytest.mark.promise("campaigns-2")
@pytest.mark.promise("readme-24")
def test_init_writes_a_campaign_and_its_mission_and_never_overwrites(call, folder, refused):
    shown = call("campaign", "init")
    assert (shown.code, sorted(listing(folder))) == (0, ["campaign.toml", "leo-geo.toml"])
    assert shown.out.endswith("Next: microrad campaign run campaign.toml\n")
    assert len(load_campaign(folder / "campaign.toml").inputs) == 4  # it can run
    assert "campaign.toml exists and is left as it is" in refused("campaign", "init")


def test_init_keeps_a_mission_that_is_there(call, folder):
    (folder / "leo-geo.toml").write_text("mine", encoding="utf-8")
    shown = call("campaign", "init", "my tails.toml")
    assert (folder / "leo-geo.toml").read_text(encoding="utf-8") == "mine"
    assert (folder / "my tails.toml").is_file() and "microrad campaign run 'my tails.toml'" in shown.out


def test_init_refuses_a_folder_that_is_not_there(refused):
    assert "there is no folder no" in refused("campaign", "init", "no/campaign.toml")


# ---------------------------------------------------------------------------------------------------------------- run
@pytest.mark.promise("campaigns-2", "campaigns-4")
def test_a_run_prints_and_keeps_what_status_shows(call, folder):
    (folder / "my runs").mkdir()
    file = written(folder / "my runs", LINKS, whole=False)
    shown = call("campaign", "run", file, "--threads", 1)
    book = folder / "my runs" / "campaign.ledger"
    assert shown.code == 0, shown.err
    assert shown.out == call("campaign", "status", book).out and shown.out.endswith(f"{book}\n")
    assert mending.verify(book, [(0, 0)]).missing == ()


@pytest.mark.promise("campaigns-2", "campaigns-4")
@pytest.mark.usefixtures("rows_here")
def test_rows_that_miss_a_limit_are_an_exit_code(call, folder):
    file = written(folder, LINKS.replace('"1 dB"', '"30 dB"'), whole=False)
    shown = call("campaign", "run", file, "--ledger", "tails.ledger", "--json")
    assert shown.code == 1, shown.err
    assert parsed(shown.out)["ledger"] == "tails.ledger"
    assert (folder / "tails.ledger").is_file() and not (folder / "campaign.ledger").exists()


def test_an_existing_ledger_is_left_and_said_before_anything_is_tuned(there, refused, monkeypatch):
    monkeypatch.setattr(run, "controllers", lambda *_: pytest.fail("tuned for nothing"))
    said = refused("campaign", "run", "campaign.toml")
    assert "there is already campaign.ledger: go on with `microrad campaign resume campaign.ledger`" in said
    assert "which is no ledger, and it stays" in refused("campaign", "run", "campaign.toml", "--ledger", "mission.toml")
    assert "which is no ledger, and it stays" in refused("campaign", "run", "campaign.toml", "--ledger", ".")


@pytest.mark.parametrize(
    "means",
    [("--threads", 1, "--workers", 1), ("--threads", 1, "--scheduler", "a:1"), ("--workers", 1, "--scheduler", "a:1")],
)
def test_ways_to_work_exclude_each_other(there, refused, means):
    for command in (("run", "campaign.toml", "--ledger", "new.ledger"), ("resume", "campaign.ledger")):
        said = refused("campaign", *command, *means)
        assert "--threads, --workers and --scheduler exclude each other" in said


@pytest.mark.parametrize(
    "address", ["", "head", "http://head:8786", "tcp://head", "tcp://head:port", "a b:1", "tcp://head:65536"]
)
def test_what_is_no_address_of_a_scheduler_is_refused(there, refused, address):
    said = refused("campaign", "run", "campaign.toml", "--ledger", "new.ledger", "--scheduler", address)
    assert f"--scheduler {address!r} is no address" in said and "tcp://head:8786" in said


def test_a_scheduler_that_is_not_there_leaves_no_ledger_behind(there, refused, monkeypatch):
    monkeypatch.setattr("microrad.campaign.engines.cluster._CONNECT_S", 1.0)
    address = "tcp://127.0.0.1:1"
    said = refused("campaign", "run", "campaign.toml", "--ledger", "new.ledger", "--scheduler", address)
    assert said.count("\n") == 1 and f"no scheduler answers at {address}" in said


@pytest.mark.promise("campaigns-56")
def test_a_scheduler_that_takes_calls_and_says_nothing_is_refused(there, refused, monkeypatch):
    monkeypatch.setattr("microrad.campaign.engines.cluster._CONNECT_S", 1.0)
    with closing(socket.create_server(("127.0.0.1", 0))) as silent, no_hang():
        address = f"tcp://127.0.0.1:{silent.getsockname()[1]}"
        said = refused("campaign", "run", "campaign.toml", "--ledger", "new.ledger", "--scheduler", address)
    assert (
        said.count("\n") == 1 and f"no scheduler answers at {address} (TimeoutError: it did not answer for 1 s)" in said
    )


@pytest.mark.promise("campaigns-56")
@pytest.mark.parametrize("another", [("--scheduler", "tcp://other:2"), ("--threads", "1")])
def test_a_scheduler_that_goes_ends_the_command_and_another_or_none_goes_on(there, call, monkeypatch, another):
    shortened(there)
    asked = []

    def gone(means, spec, late_s):
        raise CampaignError(f"the scheduler at {means.scheduler} is gone")

    with Ledger.open(there / "campaign.ledger", write=False) as book:
        before = book.done()
    monkeypatch.setattr(run.Means, "engine", gone)
    ended = call("campaign", "resume", "campaign.ledger", "--scheduler", "tcp://head:1")
    assert ended.code == 2 and "the scheduler at tcp://head:1 is gone" in ended.err
    with Ledger.open(there / "campaign.ledger", write=False) as book:
        assert book.done() == before
    monkeypatch.setattr(run.Means, "engine", lambda means, spec, late_s: asked.append(means.scheduler) or Here(spec))
    assert call("campaign", "resume", "campaign.ledger", *another).code == 0
    assert asked == ["tcp://other:2" if "--scheduler" in another else None]
    with Ledger.open(there / "campaign.ledger", write=False) as book:
        assert book.done() > before


@pytest.mark.parametrize("count", ["0", "-1", "two"])
def test_a_number_of_threads_is_at_least_one(there, refused, count):
    assert "--threads" in refused("campaign", "run", "campaign.toml", "--ledger", "new.ledger", "--threads", count)


@pytest.mark.promise("campaigns-63")
def test_a_missing_package_is_named_with_its_extra(there, call, refused, monkeypatch):
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    assert "pip install --constraint constraints.txt '.[parquet]'" in refused(
        "campaign", "export", "campaign.ledger", "rows.parquet"
    )
    for name in ("dask", "distributed"):
        monkeypatch.setitem(sys.modules, name, None)
    shown = call("campaign", "run", "campaign.toml", "--ledger", "new.ledger", "--scheduler", "a:1")
    assert (
        shown.code == 2
        and "pip install --constraint constraints.txt '.[cluster]'" in shown.err
        and "Traceback" not in shown.err
    )


# ----------------------------------------------------------------------------------------------- the wrong kind of file
@pytest.mark.promise("campaigns-4")
@pytest.mark.parametrize("command", ["run", "optimise"])
def test_what_is_no_campaign_file_is_refused(there, refused, command):
    (there / "empty").touch()
    for file, words in (
        ("nothing.toml", "`microrad campaign init` writes one"),
        ("empty", "`microrad campaign init` writes one"),
        (".", "is a directory"),
        ("campaign.ledger", "`microrad campaign resume campaign.ledger` goes on with it"),
        ("mission.toml", "mission.toml"),
    ):
        assert words in refused("campaign", command, file), file


@pytest.mark.promise("campaigns-46")
@pytest.mark.parametrize(
    "command", [("status",), ("resume",), ("verify",), ("report",), ("export", "rows.csv")], ids=lambda words: words[0]
)
def test_what_is_no_ledger_is_refused_and_nothing_is_left_beside_it(there, refused, command):
    (there / "empty").touch()
    (there / "table.csv").write_text("row,µ\n1,2\n", encoding="utf-8")
    (there / "long.txt").write_bytes(b"x" + "µ".encode() * 4096)  # the first page ends within a character
    name, *more = command
    for file, words in (
        ("nothing.ledger", "there is no ledger nothing.ledger: begin the campaign with `microrad campaign run`"),
        (".", "is a folder, not a ledger"),
        ("empty", "empty is no ledger, or its first page is damaged: name the file"),
        ("table.csv", "table.csv is no ledger, or its first page is damaged: name the file"),
        ("long.txt", "long.txt is no ledger"),
        ("campaign.toml", "is no ledger, or its first page is damaged: begin it with `microrad campaign run campaign"),
    ):
        said = refused("campaign", name, file, *more)
        assert words in said and said.count("\n") == 1, file


def test_a_ledger_goes_nowhere_but_into_a_folder(there, refused):
    assert "there is no folder no" in refused("campaign", "run", "campaign.toml", "--ledger", "no/new.ledger")


# --------------------------------------------------------------------------------------------------- status and resume
@pytest.mark.promise("campaigns-2", "campaigns-4")
def test_status_of_what_is_complete_and_of_what_is_not(there, call):
    shown, data = call("campaign", "status", "campaign.ledger"), call("campaign", "status", "campaign.ledger", "--json")
    assert (shown.code, data.code) == (0, 0) and "Complete: 64 rows" in shown.out
    assert parsed(data.out)["ledger"] == "campaign.ledger" and 64 in numbers(parsed(data.out))
    shortened(there)
    shown, data = call("campaign", "status", "campaign.ledger"), call("campaign", "status", "campaign.ledger", "--json")
    assert (shown.code, data.code) == (1, 1) and "microrad campaign resume" in shown.out
    assert parsed(data.out) and "Complete" not in shown.out


@pytest.mark.promise("campaigns-2")
@pytest.mark.usefixtures("rows_here")
@pytest.mark.promise("readme-24")
def test_resume_comes_to_what_was_there(there, call):
    before = call("campaign", "export", "campaign.ledger", "before.csv")
    shortened(there)
    shown = call("campaign", "resume", "campaign.ledger", "--threads", 1)
    assert (before.code, shown.code) == (0, 0) and "Complete: 64 rows" in shown.out
    call("campaign", "export", "campaign.ledger", "after.csv")
    assert (there / "after.csv").read_bytes() == (there / "before.csv").read_bytes()


@pytest.mark.promise("readme-12")
@pytest.mark.promise("campaigns-4", "campaigns-46")
@pytest.mark.usefixtures("rows_here")
def test_an_interrupt_says_how_to_go_on(there, call, monkeypatch):
    def interrupt(*args):
        raise KeyboardInterrupt

    shortened(there)
    (there / "campaign.ledger").rename(there / "my rows.ledger")
    with monkeypatch.context() as patched:
        patched.setattr(Here, "outcomes", interrupt)
        shown = call("campaign", "resume", "my rows.ledger")
    assert (shown.code, shown.out) == (130, "")
    assert re.search(r"stopped; \d+ rows are in my rows.ledger. Go on with: microrad campaign resume 'my", shown.err)
    with monkeypatch.context() as patched:  # after the rows, while they are read
        patched.setattr("microrad.campaign.statistics.summary.summarise_campaign", interrupt)
        shown = call("campaign", "resume", "my rows.ledger", "--threads", 1)
    assert shown.code == 130 and "Go on with: microrad campaign resume 'my rows.ledger'" in shown.err
    with monkeypatch.context() as patched:  # before there is a ledger
        patched.setattr(run, "controllers", interrupt)
        shown = call("campaign", "run", "campaign.toml", "--ledger", "new.ledger")
    assert (shown.code, shown.err) == (130, "microrad: interrupted, nothing was written\n")
    assert call("campaign", "status", "my rows.ledger").code == 0


def test_a_ledger_that_cannot_be_written_is_read_all_the_same(there, call, tmp_path_factory):
    locked = tmp_path_factory.mktemp("locked")
    shutil.copytree(there, locked, dirs_exist_ok=True)
    for step in (["mount", "--bind", locked, locked], ["mount", "-o", "remount,ro,bind", locked]):
        if subprocess.run(step, capture_output=True, check=False).returncode:
            pytest.skip("this machine does not allow to mount a folder read-only")
    try:
        assert call("campaign", "status", locked / "campaign.ledger").code == 0
        for command in (("resume", "campaign.ledger"), ("report", "campaign.ledger"), ("run", "campaign.toml")):
            name, file = command
            more = ("--ledger", locked / "new.ledger") if name == "run" else ()
            shown = call("campaign", name, locked / file, *more)
            assert (shown.code, shown.out, shown.err.count("\n")) == (2, "", 1), shown
            assert str(locked) in shown.err and "Traceback" not in shown.err
        assert listing(locked) == listing(there)
    finally:
        subprocess.run(["umount", "-l", locked], check=True)


# -------------------------------------------------------------------------------------------------------------- verify
@pytest.mark.promise("campaigns-2", "campaigns-4", "campaigns-46")
@pytest.mark.usefixtures("rows_here")
def test_verify_finds_a_flipped_bit_and_resume_mends_it(there, call):
    sound, data = call("campaign", "verify", "campaign.ledger"), call("campaign", "verify", "campaign.ledger", "--json")
    assert (sound.code, data.code) == (0, 0) and parsed(data.out)["sound"] is True
    assert "with a right checksum" in sound.out and "damaged" not in sound.out
    broken(there)
    found, data = call("campaign", "verify", "campaign.ledger"), call("campaign", "verify", "campaign.ledger", "--json")
    assert (found.code, data.code) == (1, 1) and parsed(data.out)["damaged"] == [[0, 0]]
    assert "damaged: chunk 0 of cell 0" in found.out and "Next: microrad campaign resume campaign.ledger" in found.out
    shown = call("campaign", "status", "campaign.ledger")
    assert shown.code == 2 and "`microrad campaign resume campaign.ledger` does it again" in shown.err
    assert call("campaign", "resume", "campaign.ledger", "--threads", 1).code == 0
    assert call("campaign", "verify", "campaign.ledger").code == 0


# --------------------------------------------------------------------------------------------------- export and report
@pytest.mark.promise("campaigns-2")
@pytest.mark.parametrize(
    ("name", "begins"), [("r.csv", b"cell,"), ("R.CSV", b"cell,"), ("r.parquet", b"PAR1"), ("r.nc", b"\x89HDF")]
)
def test_export_writes_and_replaces_only_what_it_wrote(there, call, refused, name, begins):
    shown = call("campaign", "export", "campaign.ledger", name)
    whole = (there / name).read_bytes()
    assert (shown.code, shown.out) == (0, f"{name}\n") and whole.startswith(begins)
    assert f"{name} exists and is left as it is" in refused("campaign", "export", "campaign.ledger", name)
    (there / name).write_bytes(whole[:1000])
    assert call("campaign", "export", "campaign.ledger", name, "--overwrite").code == 0
    assert (there / name).read_bytes()[:1000] == whole[:1000]
    (there / name).write_bytes(b"my own table")
    said = refused("campaign", "export", "campaign.ledger", name, "--overwrite")
    assert f"{name} was not written by microrad and is left as it is" in said


def test_export_replaces_no_file_of_another_kind(there, refused):
    (there / "rows.txt").write_text("my own table")
    said = refused("campaign", "export", "campaign.ledger", "rows.txt", "--overwrite")
    assert "rows.txt exists and is left as it is; choose another name." in said


@pytest.mark.parametrize("name", ["rows.txt", "rows", "no/rows.csv", "."])
def test_export_refuses_other_kinds_and_places(there, refused, name):
    assert name in refused("campaign", "export", "campaign.ledger", name)


@pytest.mark.promise("campaigns-2")
def test_the_report_is_a_page_and_replaces_nothing_but_a_page(there, call, refused):
    shown = call("campaign", "report", "campaign.ledger")
    page = (there / "campaign.html").read_text(encoding="utf-8")
    assert (shown.code, shown.out) == (0, "campaign.html\n")
    assert page.startswith("<!DOCTYPE html>") and page.rstrip().endswith("</html>")
    assert "campaign.html exists and is left as it is" in refused("campaign", "report", "campaign.ledger")
    assert call("campaign", "report", "campaign.ledger", "--overwrite").code == 0
    for victim in ("campaign.ledger", "mission.toml"):
        said = refused("campaign", "report", "campaign.ledger", victim, "--overwrite")
        assert f"{victim} was not written by microrad and is left as it is" in said
    assert "there is no folder no" in refused("campaign", "report", "campaign.ledger", "no/page.html")


# ------------------------------------------------------------------------------------------------------------ optimise
@pytest.mark.promise("readme-12")
@pytest.mark.promise("campaigns-2", "campaigns-4", "campaigns-42")
def test_optimise_finds_the_least_aperture(call, folder):
    file = written(folder, LINKS + OPTIMISE.format(low="3 cm", high="12 cm"), whole=False)
    shown, data = call("campaign", "optimise", file), call("campaign", "optimise", file, "--json")
    found = parsed(data.out)
    least = found["best"]["values"]["terminals.leo_aperture"]
    assert shown.code == data.code and shown.out.startswith("least ")
    assert found["feasible"] and 0.03 <= least < 0.12
    assert data.code == int(not found["confirmed"])
    assert found["check"] in shown.out
    assert all(each["cost"] >= least - 1e-12 for each in found["trace"] if each["feasible"])
    for rows in ("searched", "fresh"):
        assert re.search(rf"\nmargin ≥ 1 dB  {rows} +[01]\.\d\d dB +\d+\.?\d* % +[\d.]+ to [\d.]+ %\n", shown.out)
    assert "The best of the designs tried" not in shown.out
    assert sorted(p.name for p in folder.iterdir()) == ["campaign.toml", "mirror.toml", "mission.toml", "plain.toml"]


@pytest.mark.promise("campaigns-4")
def test_optimise_says_when_no_design_will_do(call, folder):
    file = written(folder, LINKS + OPTIMISE.format(low="1 cm", high="2 cm"), whole=False)
    shown, data = call("campaign", "optimise", file), call("campaign", "optimise", file, "--json")
    assert (shown.code, data.code) == (1, 1)
    assert shown.out.startswith("NO DESIGN KEEPS THE LIMITS: ") and "\nThe best of the designs tried:\n" in shown.out
    assert not parsed(data.out)["feasible"] and parsed(data.out)["reason"]


def test_optimise_needs_its_table(there, refused):
    assert "there is no table [optimise] in it" in refused("campaign", "optimise", "campaign.toml")


# ---------------------------------------------------------------------------------------------- option by option
@pytest.mark.parametrize("as_json", [False, True])
@pytest.mark.parametrize(
    ("damaged", "faults"), [((), ()), (((0, 3), (2, 11)), ()), ((), ("odd index", "odd page")), (((4, 1),), ("odd",))]
)
def test_each_damaged_chunk_and_each_fault_of_a_ledger_is_told(call, monkeypatch, damaged, faults, as_json):
    from microrad.campaign import ledger as ledgers

    found = mending.Verified(17, damaged, ((5, 6),), faults)
    monkeypatch.setattr(ledgers, "verify", lambda path: found)
    shown = call("campaign", "verify", "my rows.ledger", *["--json"] * as_json)
    sound = not damaged and not faults
    assert shown.code == (0 if sound else 1)
    if as_json:
        data = json.loads(shown.out)
        assert (data["checked"], data["sound"]) == (17, sound)
        assert data["damaged"] == [list(each) for each in damaged] and data["faults"] == list(faults)
        return
    lines = ["17 chunks with a right checksum"]
    lines += [f"damaged: chunk {number} of cell {cell}" for cell, number in damaged]
    lines += [f"damaged: {fault}" for fault in faults]
    again = "Next: microrad campaign resume 'my rows.ledger' does again what is damaged, and nothing else"
    assert shown.out.splitlines() == [*lines, *[again] * (not sound)]


@pytest.mark.parametrize(
    ("options", "means", "ledger"),
    [
        ((), (None, None, None), "sub/tails.v2.ledger"),
        (("--threads", 3), (3, None, None), "sub/tails.v2.ledger"),
        (("--workers", 5, "--ledger", "x.ledger"), (None, 5, None), "x.ledger"),
        (("--scheduler", "tcp://head:8786"), (None, None, "tcp://head:8786"), "sub/tails.v2.ledger"),
        (("--scheduler", "head:1"), (None, None, "head:1"), "sub/tails.v2.ledger"),
    ],
)
def test_a_campaign_is_run_by_the_means_and_into_the_ledger_that_are_given(call, monkeypatch, options, means, ledger):
    asked = []
    monkeypatch.setattr("microrad.campaign.run.run_campaign", lambda *given: asked.append(given[:3]))
    monkeypatch.setattr("microrad.campaign.run.resume_campaign", lambda *given: asked.append(given[:2]))
    monkeypatch.setattr(cli_campaign, "_shown", lambda path, as_json: Outcome(f"{path} {as_json}", 1))
    shown = call("campaign", "run", "sub/tails.v2.toml", *options)
    assert (shown.code, shown.out) == (1, f"{ledger} False\n")
    assert asked == [(Path("sub/tails.v2.toml"), Path(ledger), run.Means(*means))]
    asked.clear()
    given = [each for each in options if each not in ("--ledger", "x.ledger")]
    assert call("campaign", "resume", "y.ledger", *given, "--json").out == "y.ledger True\n"
    assert asked == [(Path("y.ledger"), run.Means(*means))]


@pytest.mark.parametrize(
    ("address", "taken"),
    [("tls://a:1", True), ("ucx://a-b.c:65535", True), ("http://a:1", False), ("a:123456", False), ("a/b:1", False)],
)
def test_an_address_is_one_that_dask_knows(address, taken):
    if taken:
        assert cli_campaign._means(None, None, address) == run.Means(None, None, address)
        return
    with pytest.raises(Refusal) as refusal:
        cli_campaign._means(None, None, address)
    assert str(refusal.value) == (
        f"--scheduler {address!r} is no address; `dask scheduler` prints its own, tcp://head:8786 say."
    )


@pytest.mark.parametrize(("verdict", "code"), [("pass", 0), ("fail", 1), ("open", 1), ("", 1)])
def test_only_rows_that_keep_all_limits_are_exit_0(call, monkeypatch, verdict, code):
    monkeypatch.setattr("microrad.campaign.statistics.summary.summarise_campaign", lambda path: f"of {path}")
    monkeypatch.setattr("microrad.report.campaign.words.verdict", lambda found: verdict)
    monkeypatch.setattr("microrad.report.campaign.text.campaign_text", lambda found, width: f"{found}, {width}")
    monkeypatch.setattr("microrad.report.campaign.data.campaign_data", lambda found: {"found": found})
    shown, data = call("campaign", "status", "a.ledger"), call("campaign", "status", "a.ledger", "--json")
    assert (shown.code, shown.out) == (code, "of a.ledger, 80\n\na.ledger\n")
    assert (data.code, json.loads(data.out)) == (code, {"found": "of a.ledger", "ledger": "a.ledger"})


def test_the_page_of_a_ledger_lies_beside_it_under_its_own_name(call, folder, monkeypatch):
    monkeypatch.setattr("microrad.campaign.statistics.summary.summarise_campaign", lambda path: path)
    monkeypatch.setattr("microrad.report.campaign.page.campaign_page", lambda found: f"<!DOCTYPE html>{found}")
    (folder / "sub").mkdir()
    assert call("campaign", "report", "sub/tails.v2.ledger").out == "sub/tails.v2.html\n"
    assert (folder / "sub" / "tails.v2.html").read_text("utf-8") == "<!DOCTYPE html>sub/tails.v2.ledger"
    assert call("campaign", "report", "sub/tails.v2.ledger", "other").out == "other\n"
    again = call("campaign", "report", "x.ledger", "other", "--overwrite")
    assert (again.code, (folder / "other").read_text("utf-8")) == (0, "<!DOCTYPE html>x.ledger")


@pytest.mark.parametrize("confirmed", [True, False])
def test_the_optimum_is_exit_0_where_rows_confirm_it(call, monkeypatch, confirmed):
    asked = []
    found = SimpleNamespace(confirmed=confirmed)
    monkeypatch.setattr(
        "microrad.campaign.optimisation.campaign.optimise_campaign",
        lambda file, threads, progress: asked.append((file, threads)) or found,
    )
    monkeypatch.setattr("microrad.report.campaign.optimum.optimum_text", lambda found: "the optimum")
    monkeypatch.setattr("microrad.report.campaign.optimum.optimum_data", lambda found: {"cost": 2.5})
    shown = call("campaign", "optimise", "c.toml", "--threads", 7)
    data = call("campaign", "optimise", "c.toml", "--json")
    assert (shown.code, shown.out) == (int(not confirmed), "the optimum\n")
    assert (data.code, json.loads(data.out)) == (int(not confirmed), {"cost": 2.5})
    assert asked == [(Path("c.toml"), 7), (Path("c.toml"), None)]


def test_a_campaign_is_written_in_another_folder_beside_its_mission(call, folder):
    (folder / "a b").mkdir()
    shown = call("campaign", "init", "a b/tails.toml")
    assert shown.out == ("a b/tails.toml written, for a b/leo-geo.toml. Next: microrad campaign run 'a b/tails.toml'\n")
    assert sorted(listing(folder / "a b")) == ["leo-geo.toml", "tails.toml"]


def behind(error, cause):
    error.__cause__ = cause
    return error


@pytest.mark.parametrize(
    ("name", "error", "words"),
    [
        ("my rows.ledger", KeyboardInterrupt(), "stopped; finished rows are in my rows.ledger. Go on with: {go_on}"),
        ("my rows.ledger", behind(ImportError("half"), KeyboardInterrupt()), "stopped; finished rows are in my rows"),
        ("my rows.ledger", KeyboardInterrupt("stopped; 3 rows"), "stopped; 3 rows"),
        ("none.ledger", KeyboardInterrupt(), ""),
        ("sub", KeyboardInterrupt(), ""),
        ("my rows.ledger", CampaignError("no"), "no"),
        ("none.ledger", behind(ImportError("half"), KeyboardInterrupt("x")), "half"),
    ],
)
def test_an_interrupt_says_where_finished_rows_are_unless_it_says_so_itself(folder, name, error, words):
    (folder / "my rows.ledger").touch()
    (folder / "sub").mkdir()
    with pytest.raises((Exception, KeyboardInterrupt)) as raised, cli_campaign._kept(Path(name)):
        raise error
    words = words.format(go_on="microrad campaign resume 'my rows.ledger'")
    assert str(raised.value).startswith(words) and bool(words) == bool(str(raised.value))
    told = words.startswith("stopped; finished")
    assert isinstance(raised.value, KeyboardInterrupt if told else type(error)) and (raised.value is error) is not told


@pytest.mark.parametrize(
    ("name", "begins", "other"),
    [
        ("a.csv", b"cell,", b"row,cell"),
        ("A.CSV", b"cell,", b"Cell,"),
        ("a.parquet", b"PAR1", b"PAR2"),
        ("a.b.nc", b"\x89HDF", b"\x88HDF"),
    ],
)
def test_rows_replace_a_file_of_their_own_kind_alone(call, refused, folder, monkeypatch, name, begins, other):
    asked = []

    @contextmanager
    def opened(path, write):
        yield f"book of {path}, {write}"

    monkeypatch.setattr(Ledger, "open", opened)
    monkeypatch.setattr("microrad.campaign.export.export_rows", lambda *given: asked.append(given))
    (folder / name).write_bytes(other)
    said = refused("campaign", "export", "x.ledger", name, "--overwrite")
    assert said == f"microrad: {name} was not written by microrad and is left as it is; choose another name.\n"
    (folder / name).write_bytes(begins + b"more")
    left = f"microrad: {name} exists and is left as it is; choose another name, or replace it with --overwrite.\n"
    assert refused("campaign", "export", "x.ledger", name) == left and not asked
    assert call("campaign", "export", "x.ledger", name, "--overwrite") == (0, f"{name}\n", "")
    assert asked == [("book of x.ledger, False", Path(name))]


@pytest.mark.parametrize(
    "both",
    [
        ("--threads", "2", "--workers", "2"),
        ("--workers", "1", "--scheduler", "a:1"),
        ("--threads", "1", "--scheduler", "a"),
    ],
)
@pytest.mark.parametrize("command", [("run", "c.toml"), ("resume", "c.ledger")])
def test_two_ways_to_work_are_refused_by_run_and_resume_before_anything(refused, monkeypatch, command, both):
    monkeypatch.setattr("microrad.campaign.run.run_campaign", lambda *given: pytest.fail("it ran"))
    monkeypatch.setattr("microrad.campaign.run.resume_campaign", lambda *given: pytest.fail("it ran"))
    words = "--threads, --workers and --scheduler exclude each other; give one of them."
    assert refused("campaign", *command, *both) == f"microrad: {words}\n"


def test_one_sound_chunk_is_told_as_one(call, monkeypatch):
    monkeypatch.setattr("microrad.campaign.ledger.verify", lambda path: mending.Verified(1, (), (), ()))
    assert call("campaign", "verify", "rows.ledger").out == "1 chunk with a right checksum\n"


@pytest.mark.parametrize("command", ["run", "resume"])
@pytest.mark.parametrize("within", ["the run", "what is shown"])
def test_an_interrupt_of_a_run_or_of_what_it_shows_names_the_ledger(call, folder, monkeypatch, command, within):
    def interrupt(*given, **more):
        raise KeyboardInterrupt

    (folder / "sub").mkdir()
    (folder / "sub" / "my tails.ledger").touch()
    for name in ("run_campaign", "resume_campaign"):
        monkeypatch.setattr(run, name, interrupt if within == "the run" else lambda *given: None)
    monkeypatch.setattr("microrad.campaign.statistics.summary.summarise_campaign", interrupt)
    file = "sub/my tails.toml" if command == "run" else "sub/my tails.ledger"
    shown = call("campaign", command, file)
    go_on = "Go on with: microrad campaign resume 'sub/my tails.ledger'"
    words = f"microrad: stopped; finished rows are in sub/my tails.ledger. {go_on}\n"
    assert (shown.code, shown.out, shown.err) == (130, "", words)


@pytest.mark.parametrize(("command", "file"), [("run", "c.toml"), ("resume", "c.ledger"), ("optimise", "c.toml")])
def test_progress_of_many_rows_is_a_line_every_half_minute_in_a_log(call, monkeypatch, command, file):
    asked = []

    @contextmanager
    def bar(line_s):
        asked.append(line_s)
        yield "progress"

    found = SimpleNamespace(confirmed=True)
    monkeypatch.setattr(cli_campaign, "progress_bar", bar)
    monkeypatch.setattr(cli_campaign, "_shown", lambda path, as_json: Outcome("shown"))
    for name in ("run_campaign", "resume_campaign"):
        monkeypatch.setattr(run, name, lambda *given: asked.append(given[-1]))
    monkeypatch.setattr(
        "microrad.campaign.optimisation.campaign.optimise_campaign",
        lambda file, threads, progress: asked.append(progress) or found,
    )
    monkeypatch.setattr("microrad.report.campaign.optimum.optimum_text", lambda found: "shown")
    assert call("campaign", command, file) == (0, "shown\n", "")
    assert asked == [30.0, "progress"]


@pytest.mark.parametrize(("command", "begins"), [("report", "<!DOCTYPE html>"), ("export", "cell,")])
def test_a_disk_that_takes_no_page_and_no_rows_is_told_with_the_file(call, folder, monkeypatch, command, begins):
    """What is there stays as it is."""

    @contextmanager
    def opened(path, write):
        yield "book"

    def full(*given):
        raise OSError(28, "No space left on device", "x.csv")

    monkeypatch.setattr(Ledger, "open", opened)
    monkeypatch.setattr("microrad.campaign.statistics.summary.summarise_campaign", lambda path: "found")
    monkeypatch.setattr("microrad.report.campaign.page.campaign_page", lambda found: "<!DOCTYPE html>new")
    monkeypatch.setattr("microrad.campaign.export.export_rows", full)
    monkeypatch.setattr(cli_campaign, "write_whole", full)
    (folder / "x.csv").write_text(f"{begins}old", "utf-8")
    shown = call("campaign", command, "rows.ledger", "x.csv", "--overwrite")
    words = "x.csv: No space left on device; nothing was written there. Check free space and permissions."
    assert (shown.code, shown.out, shown.err) == (2, "", f"microrad: {words}\n")
    assert (folder / "x.csv").read_text("utf-8") == f"{begins}old"
