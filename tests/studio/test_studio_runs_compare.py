"""What the studio's pages of the mission, of runs and of comparisons show, without a browser."""

import json
import math
import os
import re
import tomllib
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path
from types import SimpleNamespace

import pytest

from drawn import block_lines
from microrad.link import study as link_study
from microrad.mission.file import load_link
from microrad.mission.presets import preset_text
from microrad.report.tables import Cell
from microrad.studio import commands
from microrad.studio.draft.draft import Draft, DraftError
from microrad.studio.draft.tables import offered, with_table
from microrad.studio.jobs.queue import Job, JobError, Progress
from microrad.studio.session import Session
from microrad.studio.views import compare as compare_view
from microrad.studio.views import runs as runs_view
from microrad.studio.views.compare import Number
from shipped import DEFAULT, SHIPPED, links_alone


@pytest.fixture
def draft(session):
    return session.draft


# ---------------------------------------------------------------------------------------------------- optional tables
def test_tables_that_the_papers_mission_could_get():
    found = offered(Draft.shipped("x.toml"))
    wanted = {"channel", "jitter", "communication.beam", "communication.receiver", "fine_pointing.wheels"}
    assert wanted <= set(found)
    assert not {"beacon", "orbit", "mirror", "pointing"} & set(found)


@pytest.mark.promise("studio-12")
def test_a_commented_example_comes_to_life_where_it_stands(draft):
    got = with_table(draft, "fine_pointing.wheels")
    lines = got.text.split("\n")
    assert len(lines) == len(draft.text.split("\n"))
    changed = [(a, b) for a, b in zip(draft.text.split("\n"), lines, strict=True) if a != b]
    assert [(a.removeprefix("# "), b) for a, b in changed] == [(b, b) for _, b in changed]
    assert len(changed) == 5
    assert got.file().mission.fine_pointing.wheels.speed_hz == 50.0


@pytest.mark.parametrize("name", offered(Draft.shipped("x.toml")))
def test_each_example_leaves_every_other_value_as_it_is(draft, name):
    got = with_table(draft, name)
    assert name not in offered(got)
    others = {key: value.typed for key, value in got.values.items() if not key.startswith(f"{name}.")}
    assert others == {key: value.typed for key, value in draft.values.items()}
    own = [key for key in got.values if key.startswith(f"{name}.")]
    assert own
    assert [got.values[key].problems for key in own if "threshold" not in key] == [()] * len(
        [key for key in own if "threshold" not in key]
    )


@pytest.mark.parametrize("name", ["channel", "jitter", "fine_pointing.wheels", "mirror.creep"])
def test_examples_that_need_nothing_else_leave_no_fault(draft, name):
    assert with_table(draft, name).problems == ()


def test_an_outermost_table_comes_with_its_inner_ones(draft):
    link = draft.with_text(links_alone(SHIPPED.read_text("utf-8")))
    got = with_table(link, "orbit")
    tables = tomllib.loads(got.text)["orbit"]
    shipped = tomllib.loads(DEFAULT.read_text("utf-8"))["orbit"]
    assert tables == shipped
    assert "orbit" not in tomllib.loads(link.text)


def test_an_inner_table_without_its_outer_one_is_not_offered(draft):
    found = offered(draft.with_text(links_alone(SHIPPED.read_text("utf-8"))))
    assert "fine_pointing" in found
    assert "fine_pointing.wheels" not in found


def test_a_table_that_is_there_is_not_added_twice(draft):
    for name in ("beacon", "no_table"):
        with pytest.raises(DraftError, match=rf"\[{name}\] cannot be added: it is there already, or a mission has no"):
            with_table(draft, name)


def test_an_example_above_keys_of_another_table_goes_to_the_end(draft):
    text = '[fine_pointing]\n# [channel]\n# elevation = "30 deg"\nrate = "5 kHz"\n'
    got = with_table(draft.with_text(text), "channel")
    assert tomllib.loads(got.text)["fine_pointing"] == {"rate": "5 kHz"}
    assert tomllib.loads(got.text)["channel"]["elevation"] == "30 deg"


@pytest.mark.parametrize("end", ["", "\n", "\n\n[beacon]\n"])
def test_an_example_at_the_very_end_of_a_text_comes_to_life_there(draft, end):
    got = with_table(draft.with_text(f'# [channel]\n# elevation = "30 deg"{end}'), "channel")
    assert got.text == f'[channel]\nelevation = "30 deg"{end}'


@pytest.mark.parametrize(
    "text", ["# [channel]\n\n# elevation = 1\n", "# [no_table]\n# x = 1\n", "# [channel] of air\n# elevation = 1\n"]
)
def test_a_comment_that_is_no_example_stays_one(draft, text):
    """A header without keys below it, a table that no mission has, words about a table."""
    found = draft.with_text(text)
    assert "no_table" not in offered(found)
    assert with_table(found, "channel").text.startswith(text.rstrip() + "\n\n")


def test_an_inner_table_is_offered_where_another_inner_one_of_its_table_is_there(draft):
    for header, there in (("[fine_pointing.body]", True), ("[fine_pointing]", True), ("[fine_pointings]", False)):
        assert ("fine_pointing.wheels" in offered(draft.with_text(f"{header}\n"))) == there
    assert "fine_pointing.body" not in offered(draft.with_text("[fine_pointing.body.inner]\n"))


# --------------------------------------------------------------------------------------------------------------- runs
def test_a_name_that_nothing_has_yet(session):
    assert runs_view.free_name(session, "found") == "found"
    (session.folder / "found").mkdir()
    assert runs_view.free_name(session, "found") == "found-2"
    (session.folder / "found-2").mkdir()
    assert runs_view.free_name(session, "found") == "found-3"
    assert runs_view.free_name(session, "found", ".ledger") == "found.ledger"


def test_a_name_that_a_waiting_job_will_take_is_taken(session, monkeypatch):
    job = Job(1, session.folder, "queued", results=("found/report.html", "found/results.nc"))
    monkeypatch.setattr(type(session.jobs), "listed", lambda self: (job,))
    assert runs_view.free_name(session, "found") == "found-2"
    monkeypatch.setattr(type(session.jobs), "listed", lambda self: (replace(job, state="cancelled"),))
    assert runs_view.free_name(session, "found") == "found"


def test_a_result_without_a_name_takes_none(session, monkeypatch):
    job = Job(1, session.folder, "running", results=("", "x/y.html"))
    monkeypatch.setattr(type(session.jobs), "listed", lambda self: (job,))
    assert (runs_view.free_name(session, "x"), runs_view.free_name(session, "y")) == ("x-2", "y")


def test_a_campaign_file_may_be_as_large_as_any_that_is_read(session, monkeypatch):
    text = 'mission = "leo-geo.toml"\n'
    (session.folder / "c.toml").write_text(text, "utf-8")
    monkeypatch.setattr(runs_view, "MAX_BYTES", len(text) - 1)
    assert runs_view.campaign_files(session) == ()
    monkeypatch.setattr(runs_view, "MAX_BYTES", len(text))
    assert runs_view.campaign_files(session) == ("c.toml",)


@pytest.mark.parametrize(
    ("text", "names"),
    [
        ("mission = 'm.toml'", True),
        ("mission = 3", False),
        ("[a]\nmission = 'm'", False),
        ("x = 1\r\nmission = 'm'", True),
    ],
)
def test_a_campaign_file_names_a_mission_in_quotes_at_its_root(session, text, names):
    (session.folder / "c.toml").write_bytes(text.encode())
    assert ("c.toml" in runs_view.campaign_files(session)) == names


def test_ledgers_are_files_in_the_order_of_their_names(session):
    (session.folder / "folder.ledger").mkdir()
    for name in ("b.ledger", "a.ledger", "x.ledger-wal"):
        (session.folder / name).touch()
    assert runs_view.ledgers(session) == ("a.ledger", "b.ledger")


def test_campaign_files_are_told_from_missions(session):
    path = runs_view.write_campaign(session)
    (session.folder / "broken.toml").write_text("mission = [", "utf-8")
    (session.folder / "binary.toml").write_bytes(b"\xff\x00")
    (session.folder / "deep.toml").write_text("a." * 200_000 + "b = 1", "utf-8")  # minutes for a parser
    assert runs_view.campaign_files(session) == ("campaign.toml",)
    assert path.name == "campaign.toml"
    assert runs_view.write_campaign(session).name == "campaign-2.toml"


def test_an_example_campaign_names_the_mission_that_is_edited(session):
    session.change(session.draft.save(session.inside("mine.toml")))
    assert tomllib.loads(runs_view.write_campaign(session).read_text("utf-8"))["mission"] == "mine.toml"
    odd = 'a"b\\c\n.toml'
    session.change(session.draft.save(session.inside(odd)))
    path = runs_view.write_campaign(session)
    assert tomllib.loads(path.read_text("utf-8"))["mission"] == odd
    path.unlink()
    session.change(Draft.shipped(session.inside("unsaved.toml")))
    with pytest.raises(JobError, match=r"unsaved\.toml is not saved yet, and a campaign reads it from its file"):
        runs_view.write_campaign(session)
    assert not (session.folder / "campaign-2.toml").exists()


def test_an_action_becomes_a_job_in_the_working_folder(session):
    action = commands.campaign(Path("campaign.toml"), Path("x.ledger"))
    order = runs_view.order(session, "campaign", action)
    assert (order.title, order.cwd, order.results) == ("Campaign campaign.toml", session.folder, ("x.ledger",))
    assert order.arguments == action.arguments


def test_the_report_of_a_ledger_as_a_command():
    action = commands.campaign_report(Path("x.ledger"), Path("x.html"))
    assert action.command == "microrad campaign report x.ledger x.html --overwrite"
    compile(action.python, "copied", "exec")
    assert action.results == ("x.html",)


def test_progress_in_words():
    assert runs_view.progress_words(None) == "starting"
    assert runs_view.progress_words(Progress(3, 12, "rows")) == "25 %, 3 of 12 rows"
    assert runs_view.progress_words(Progress(3, 12, "budgets")) == "25 %, 3 of 12: budgets"
    assert runs_view.progress_words(Progress(1, 160, "rows")) == "0.6 %, 1 of 160 rows"
    assert runs_view.progress_words(Progress(0, 160, "rows")) == "0 %, 0 of 160 rows"
    assert runs_view.progress_words(Progress(3, 12, "rows", 0.5)) == "25 %, 3 of 12 rows; 0.5 a second, 18 s left"
    assert runs_view.progress_words(Progress(3, 2, "rows", 1.0)) == "100 %, 3 of 2 rows; 1 a second, 0 s left"


@pytest.mark.parametrize(
    ("share", "words"),
    [
        (0.0, "0 %"),
        (0.001, "0.1 %"),
        (0.0994, "9.9 %"),
        (0.0996, "10 %"),
        (0.1, "10 %"),
        (0.104, "10 %"),
        (0.9996, "99 %"),
        (1.0, "100 %"),
    ],
)
def test_a_small_share_has_a_decimal(share, words):
    assert runs_view._percent(share) == words


@pytest.mark.parametrize(("rate", "words"), [(None, "50 %, 2 of 4 rows"), (0.0, "50 %, 2 of 4 rows")])
def test_without_a_rate_nobody_knows_how_long_it_takes(rate, words):
    assert runs_view.progress_words(Progress(2, 4, "rows", rate)) == words


def test_the_state_of_a_job_in_words(tmp_path):
    job = Job(1, tmp_path, "done", "study", code=1)
    assert runs_view.state_words(job) == "done: not every requirement is met"
    assert runs_view.state_words(replace(job, code=0)) == "done: every requirement is met"
    assert runs_view.state_words(replace(job, kind="campaign")) == "done: the rows do not keep the limits"
    assert runs_view.state_words(replace(job, kind="export", code=0)) == "done"
    assert runs_view.state_words(replace(job, state="running", code=None)) == "running"
    assert runs_view.state_words(replace(job, state="running", cancelling=True, code=None)) == "stopping ..."
    assert runs_view.state_words(replace(job, state="lost", code=None)) == "lost"
    assert runs_view.state_words(replace(job, state="queued", code=None)) == "waiting for the job before it"


def test_the_times_of_a_job_in_words(tmp_path):
    job = Job(1, tmp_path, "done", queued="2026-03-20T12:00:00Z")
    assert runs_view.time_words(job) == "put in the queue 2026-03-20 12:00:00 UTC"
    assert runs_view.time_words(replace(job, state="unreadable", queued="")) == ""
    job = replace(job, started="2026-03-20T12:01:00Z", ended="2026-03-20T12:03:05Z")
    assert runs_view.time_words(job) == "started 2026-03-20 12:01:00 UTC, 2.08 min"
    now = datetime(2026, 3, 20, 12, 1, 30, tzinfo=UTC)
    assert runs_view.time_words(replace(job, ended=""), lambda: now).endswith(", 30 s")
    assert runs_view.time_words(replace(job, ended="odd"), lambda: now).endswith(", 30 s")
    assert runs_view.time_words(replace(job, started="odd")) == "started "
    assert runs_view.time_words(replace(job, ended="2026-03-20T12:00:59Z")).endswith(", 0 s")  # a clock was set
    assert runs_view.time_words(replace(job, ended="")).startswith("started 2026-03-20 12:01:00 UTC, ")
    assert runs_view.time_words(replace(job, started="", queued="odd")) == "put in the queue "


def test_a_campaigns_own_pace_does_not_stand_beside_that_of_the_job():
    progress = Progress(3, 12, "7.5 rows/s, 9 s left, margin 1 %: 3.1 dB", 0.5)
    assert runs_view.progress_words(progress) == "25 %, 3 of 12 rows; 0.5 a second, 18 s left"
    assert runs_view.progress_words(replace(progress, what="tuning PI")).startswith("25 %, 3 of 12: tuning PI; ")


def campaign(folder, number, state="done", ledger="x.ledger"):
    return Job(number, folder, state, "campaign", arguments=("campaign",), cwd=folder, results=(ledger,))


def report(folder, number, state="done", ledger="x.ledger"):
    action = commands.campaign_report(Path(ledger), Path("x.html"))
    return Job(number, folder, state, "export", arguments=action.arguments, cwd=folder, results=action.results)


def test_the_last_job_of_a_ledger_is_the_one_to_go_on_from(tmp_path):
    first, other, again = (
        campaign(tmp_path, n, ledger=name) for n, name in ((1, "x.ledger"), (2, "y.ledger"), (3, "x.ledger"))
    )
    jobs = (again, other, first)
    assert runs_view.others(jobs, first) == runs_view.Others()
    assert runs_view.others(jobs, other) == runs_view.Others(newest=True)
    assert runs_view.others(jobs, again) == runs_view.Others(newest=True, latest=True)
    assert runs_view.others((other, first), first) == runs_view.Others(newest=True)
    study = Job(4, tmp_path, "done", "study", results=("report.html",))
    assert runs_view.others((study, *jobs), study) == runs_view.Others()
    assert runs_view.others((study, *jobs), again).latest


def test_a_campaigns_report_is_found_once_it_is_written_of_the_ledger_as_it_is(tmp_path):
    done = campaign(tmp_path, 1)

    def found(*later):
        return runs_view.others((*later, done), done).report

    assert found() is None
    waiting = report(tmp_path, 2, "queued")
    assert found(waiting) is waiting
    written = report(tmp_path, 2)
    assert found(written) is None  # its page was removed
    (tmp_path / "x.html").write_text("page", "utf-8")
    assert found(written) is written
    assert found(report(tmp_path, 2, "failed")) is None
    assert found(report(tmp_path, 2, ledger="y.ledger")) is None
    newer = report(tmp_path, 3, "running")
    assert found(newer, written) is newer
    again = campaign(tmp_path, 3)
    assert runs_view.others((again, written, done), again).report is None  # it is of the rows before


def test_the_ledger_of_a_campaign_lies_in_the_folder(session, tmp_path_factory):
    folder, outside = session.folder, tmp_path_factory.mktemp("outside")
    assert runs_view.ledger_path(session, campaign(folder, 1)) == folder / "x.ledger"
    assert runs_view.ledger_path(session, campaign(outside, 1)) is None
    assert runs_view.ledger_path(session, campaign(folder, 1, ledger="../x.ledger")) is None
    (folder / "x.ledger").symlink_to(outside / "x.ledger")
    assert runs_view.ledger_path(session, campaign(folder, 1)) is None
    assert runs_view.ledger_path(session, Job(1, folder, "done", "study", results=("x.ledger",))) is None


def test_the_ledger_is_the_result_of_a_campaign_that_ends_like_one(session):
    job = Job(1, session.folder, "done", "campaign", cwd=session.folder, results=("x.html", "x.ledger"))
    assert runs_view.ledger_of(job) == "x.ledger"
    assert runs_view.ledger_of(replace(job, results=("x.html",))) is None
    assert runs_view.ledger_of(replace(job, kind="study")) is None
    assert runs_view.ledger_path(session, replace(job, results=())) is None


def test_a_ledger_that_is_named_like_an_option_is_none():
    action = commands.campaign_report(Path("-x.ledger"), Path("--help"))
    assert action.arguments == ("campaign", "report", "./-x.ledger", "./--help", "--overwrite")


@pytest.mark.promise("studio-18")
def test_only_results_that_are_there_and_inside_are_offered(session, tmp_path_factory):
    outside = tmp_path_factory.mktemp("outside") / "secret.html"
    outside.write_text("secret", "utf-8")
    (session.folder / "page.html").write_text("page", "utf-8")
    job = Job(1, session.folder, "done", cwd=session.folder, results=(str(outside), "missing.nc", "page.html"))
    assert runs_view.result_files(session, job) == ((2, "page.html"),)
    for state in ("failed", "cancelled"):  # another run has written it
        assert runs_view.result_files(session, replace(job, state=state, kind="identification")) == ()
        assert runs_view.result_files(session, replace(job, state=state, kind="campaign")) == ((2, "page.html"),)


# ------------------------------------------------------------------------------------------------------------ compare
@pytest.mark.promise("studio-12")
def test_keys_that_differ_with_their_sources(draft):
    there = draft.set("terminals.leo_aperture", "6 cm").set("conventions.strehl", "ratio")
    found = compare_view.differences(draft, there)
    assert [row[0] for row in found] == ["terminals.leo_aperture", "conventions.strehl"]
    assert found[0][1:] == ("5 cm\npaper: Table 2", f"6 cm\n{there.values['terminals.leo_aperture'].source}")
    assert [cell.partition("\n")[0] for cell in found[1][1:]] == ["decibel", "ratio"]
    assert compare_view.differences(draft, draft) == []


@pytest.mark.parametrize(
    ("key", "same", "other"),
    [
        ("terminals.leo_aperture", "50 mm", "51 mm"),
        ("communication.data_rate", "0.3 Gbit/s", "0.31 Gbit/s"),
        ("beacon.required_power", "0.01 nW", "10.0001 pW"),
        ("pointing.confidence", "0.9970", "0.998"),
        ("scenario.pid_frequencies", "1000 mHz, 15 Hz", "1000 mHz, 16 Hz"),
        ("orbit.leo.inclination", "sun-synchronous", "97 deg"),
    ],
)
def test_an_equal_quantity_in_another_unit_is_no_difference(draft, key, same, other):
    assert compare_view.differences(draft, draft.set(key, same)) == []
    assert [row[0] for row in compare_view.differences(draft, draft.set(key, other))] == [key]


def test_a_table_of_one_mission_alone_is_one_difference(draft):
    there = with_table(draft, "channel")
    (found,) = compare_view.differences(draft, there)
    assert found == ("[channel]", "not given", "2 keys")
    (found,) = compare_view.differences(there, draft)
    assert found[1:] == ("2 keys", "not given")


def test_a_key_of_one_mission_alone_is_not_given_in_the_other(draft):
    fewer = draft.without("terminals.leo_aperture").without("name")
    for here, there, order in ((draft, fewer, 1), (fewer, draft, -1)):
        found = {row[0]: row[1:][::order] for row in compare_view.differences(here, there)}
        assert {*found} == {"name", "terminals.leo_aperture"}
        assert found["terminals.leo_aperture"] == ("5 cm\npaper: Table 2", "not given")
        assert found["name"][1] == "not given"


@pytest.mark.parametrize(
    ("here", "there", "same"),
    [
        ("1", "1.0", True),
        ("1", "2", False),
        ("1", "true", False),
        ("'a'", '"a"', True),
        ("'1'", "1", False),
        ("[1, 2]", "[1,2]", True),
        ("not toml", "not toml", True),
        ("not toml", "nor this", False),
    ],
)
def test_a_value_of_a_key_that_nobody_knows_differs_by_what_toml_makes_of_it(draft, here, there, same):
    ours, theirs = (draft.with_text(f"unknown = {each}\n") for each in (here, there))
    assert (compare_view.differences(ours, theirs) == []) == same


def test_a_quantity_that_is_none_differs_by_its_text(draft):
    parsec, again = draft.set("terminals.leo_aperture", "5 parsec"), draft.set("terminals.leo_aperture", "6 parsec")
    assert [row[0] for row in compare_view.differences(parsec, again)] == ["terminals.leo_aperture"]
    assert compare_view.differences(parsec, parsec.with_text(parsec.text)) == []


def study_of(margin_db, possible=True, **parts):
    """What a study of the links of a mission comes to, as far as it is compared; it has the `parts`."""
    budget = SimpleNamespace(name="Communication", margin_db=margin_db, received_power_w=1e-9)
    beam = SimpleNamespace(name="Beacon", margin_db=0.0, received_power_w=1e-12)
    mission = SimpleNamespace(
        requirement=SimpleNamespace(margin_db=3.0), communication=SimpleNamespace(data_rate_bit_s=3e8)
    )
    outcome = SimpleNamespace(success_probability=0.9, mean_time_s=12.0)
    built = {
        "open_loop": SimpleNamespace(rss_rad=3e-4),
        "finding": SimpleNamespace(wide=SimpleNamespace(outcome=outcome, possible=possible)),
    }
    return SimpleNamespace(
        file=SimpleNamespace(mission=mission),
        budgets=[budget, beam],
        communication=budget,
        largest_rate_bit_s=4e8,
        **{name: built[name] if name in parts else None for name in built},
    )


NUMBERS = ("Communication: margin", "Communication: received power", "Beacon: margin", "Beacon: received power")
RATES = ("Data rate", "Largest data rate with the required margin")
POINTED = ("Open-loop pointing error, root sum square",)
PROBABLE, MEAN = ("Acquisition by the wide beacon: probability",), ("Acquisition by the wide beacon: mean time",)


@pytest.mark.parametrize(
    ("parts", "possible", "more"),
    [
        ((), True, ()),
        (("open_loop",), True, POINTED),
        (("finding",), True, PROBABLE + MEAN),
        (("finding",), False, PROBABLE),
        (("open_loop", "finding"), True, POINTED + PROBABLE + MEAN),
    ],
)
def test_a_mission_is_compared_by_what_it_has(draft, monkeypatch, parts, possible, more):
    study = study_of(3.0, possible, **dict.fromkeys(parts))
    monkeypatch.setattr(compare_view.link_study, "run_link_study", lambda file: study)
    found = compare_view.link_numbers(draft)
    assert tuple(each.name for each in found) == NUMBERS + RATES + more
    assert found[2].text == "0.00 dB" and found[2].required == "0.00 dB"
    shown = {each.name: (each.value, each.unit) for each in found}
    assert [shown[name] for name in RATES] == [(3e8, "bit/s"), (4e8, "bit/s")]
    assert shown.get(POINTED[0], (3e-4, "rad")) == (3e-4, "rad")
    assert (shown.get(PROBABLE[0], (0.9, "")), shown.get(MEAN[0], (12.0, "s"))) == ((0.9, ""), (12.0, "s"))


@pytest.mark.parametrize(("margin_db", "met"), [(3.0, True), (3.0 - 1e-10, True), (2.999, False), (3.1, True)])
def test_a_margin_met_but_for_rounding_is_met(draft, monkeypatch, margin_db, met):
    monkeypatch.setattr(compare_view.link_study, "run_link_study", lambda file: study_of(margin_db))
    margin, _, beacon, *_ = compare_view.link_numbers(draft)
    assert (margin.required, margin.met, beacon.met) == ("3.00 dB", met, True)


@pytest.mark.promise("studio-12")
def test_the_numbers_are_those_of_the_link_study(session, draft):
    found = {each.name: each for each in compare_view.link_numbers(draft)}
    study = link_study.run_link_study(load_link(session.folder / "leo-geo.toml"))
    for budget in study.budgets:
        assert found[f"{budget.name}: margin"].value == budget.margin_db
        assert found[f"{budget.name}: received power"].value == budget.received_power_w
    margin = found["Communication: margin"]
    assert (margin.text, margin.required, margin.met) == ("3.00 dB", "3.00 dB", True)
    weak = {each.name: each for each in compare_view.link_numbers(draft.set("communication.transmit_power", "4 W"))}
    assert weak["Communication: margin"].met is False
    with pytest.raises(ValueError, match="parsec"):
        compare_view.link_numbers(draft.set("terminals.leo_aperture", "5 parsec"))


def test_numbers_beside_each_other_with_their_change():
    here, there = (
        (Number("margin", 3.0, "dB", "2.00 dB", True), Number("a", 1.0, "W")),
        (Number("margin", 1.5, "dB", "2.00 dB", False), Number("b", 1.0, "")),
    )
    assert compare_view.beside(here, there) == [
        ("margin", Cell("3.00 dB, required 2.00 dB", "PASS"), Cell("1.50 dB, required 2.00 dB", "FAIL"), "−1.50 dB"),
        ("a", "1 W", "none", ""),
        ("b", "none", "1", ""),
    ]
    assert compare_view.beside(there, here)[0][3] == "+1.50 dB"
    assert compare_view.beside(here, here)[0][3] == "same"


@pytest.mark.promise("readme-15")
@pytest.mark.promise("studio-12", "studio-13")
def test_two_missions_are_compared_in_the_report_s_views(session, draft):
    there, names = draft.set("terminals.leo_aperture", "6 cm"), ("a.toml", "b.toml")
    links, verdicts, differ = compare_view.blocks(session, draft, there, names)
    (table,) = links.blocks
    assert table.headings == ("number", "in a.toml", "in b.toml", "change")
    assert [row[0] for row in table.rows][:2] == ["Communication: margin", "Communication: received power"]
    assert [block.text for block in verdicts.blocks] == [
        f"{name}: no study of this text is in the folder; the page Runs makes one." for name in names
    ]
    count, table = differ.blocks
    assert (count.partition(";")[0], [row[0] for row in table.rows]) == ("1 key differs", ["terminals.leo_aperture"])
    links, _, differ = compare_view.blocks(session, draft, draft.set("terminals.leo_aperture", "5 parsec"), names)
    said, table = links.blocks
    assert said.headline.startswith("b.toml has no link budget:\n") and "parsec" in said.headline
    assert not said.good and {row[2] for row in table.rows} == {"none"}
    (same,) = compare_view.blocks(session, draft, draft, names)[2].blocks
    assert same.text == "Every key has the same value in both."


@pytest.mark.promise("studio-12")
def test_the_study_of_exactly_this_text_is_found(session, draft):
    def put(folder, sha256, verdict):
        requirement = {"name": "margin", "unit": "dB", "required": 3.0, "actual": 2.0, "met": False}
        summary = {"verdict": verdict, "closes": True, "requirements": [requirement, {**requirement, "actual": None}]}
        (session.folder / folder).mkdir()
        data = json.dumps({"mission": {"sha256": sha256}, "summary": summary})
        (session.folder / folder / "manifest.json").write_text(data, "utf-8")

    assert compare_view.finished_study(session, draft) is None
    put("other", "0" * 64, "of another text")
    (session.folder / "broken").mkdir()
    (session.folder / "broken" / "manifest.json").write_text("{", "utf-8")
    assert compare_view.finished_study(session, draft) is None
    put("mine", draft.sha256, "of this text")
    found = compare_view.finished_study(session, draft)
    assert (found.folder, found.verdict, found.met) == ("mine", "of this text", False)
    assert [(each.text, each.required, each.met) for each in found.numbers] == [("2.00 dB", "3.00 dB", False)]
    assert compare_view.finished_study(session, draft.set("terminals.leo_aperture", "6 cm")) is None
    put("again", draft.sha256, "a second one")
    for latest, older in (("mine", "again"), ("again", "mine")):
        os.utime(session.folder / older / "manifest.json", (1e9, 1e9))
        os.utime(session.folder / latest / "manifest.json", (2e9, 2e9))
        assert compare_view.finished_study(session, draft).folder == latest


def finished(session, draft, folder, **summary):
    """The manifest of a finished study of the draft in a folder of the working folder."""
    rows = [{"name": "margin", "unit": "dB", "required": 3.0, "actual": 4.0, "met": True}]
    data = {"mission": {"sha256": draft.sha256}, "summary": {"verdict": "it closes", "requirements": rows} | summary}
    (session.folder / folder).mkdir()
    path = session.folder / folder / "manifest.json"
    path.write_text(json.dumps(data), "utf-8")
    return path


def test_finished_studies_stand_beside_each_other(session, draft):
    there = draft.set("terminals.leo_aperture", "6 cm").set("beacon.strehl", "0.5")
    finished(session, draft, "first")
    _, verdicts, differ = compare_view.blocks(session, draft, there, ("a.toml", "b.toml"))
    verdict, none, table = verdicts.blocks
    assert (verdict.headline, verdict.good) == ("a.toml: it closes (first)", True)
    assert none.text == "b.toml: no study of this text is in the folder; the page Runs makes one."
    assert table.headings == ("number", "in a.toml", "in b.toml", "change")
    assert table.rows == [("margin", Cell("4.00 dB, required 3.00 dB", "PASS"), "none", "")]
    assert differ.blocks[0].startswith("2 keys differ; ")
    swapped = compare_view.blocks(session, there, draft, ("b.toml", "a.toml"))[1].blocks[2]
    assert swapped.rows[0][1:3] == ("none", Cell("4.00 dB, required 3.00 dB", "PASS"))


def test_only_manifests_of_a_size_that_microrad_writes_are_read_and_not_too_many(session, draft, monkeypatch):
    size = finished(session, draft, "a").stat().st_size
    for most, found in ((size, True), (size - 1, False)):
        monkeypatch.setattr(compare_view, "_MOST_BYTES", most)
        assert (compare_view.finished_study(session, draft) is not None) == found
    monkeypatch.setattr(compare_view, "_MOST_BYTES", size)
    (session.folder / "0").mkdir()
    (session.folder / "0" / "manifest.json").write_text("{}", "utf-8")
    for most, found in ((2, True), (1, False)):
        monkeypatch.setattr(compare_view, "_MOST_FOLDERS", most)
        assert (compare_view.finished_study(session, draft) is not None) == found


def test_a_study_with_a_requirement_that_is_not_known_is_not_met(session, draft):
    known = {"name": "margin", "unit": "dB", "required": 3.0, "actual": 4.0, "met": True}
    for folder, others in (("known", []), ("unknown", [{**known, "actual": None, "met": False}])):
        (session.folder / folder).mkdir()
        summary = {"verdict": "as it is", "requirements": [known, *others]}
        data = json.dumps({"mission": {"sha256": draft.sha256}, "summary": summary})
        (session.folder / folder / "manifest.json").write_text(data, "utf-8")
        found = compare_view.finished_study(session, draft)
        assert ([each.met for each in found.numbers], found.met) == ([True], not others)
        (session.folder / folder / "manifest.json").unlink()


# ------------------------------------------------------------------------------------------- the other, kept on disk
def again(session):
    return Session(session.folder)


@pytest.mark.promise("studio-8")
def test_the_other_mission_survives_a_restart(session, draft):
    assert again(session).other is None
    paper = Draft.shipped(session.inside("leo-geo.toml"))
    for other in (
        draft.set("terminals.leo_aperture", "6 cm").save(session.inside("wide.toml")),
        paper,
        paper.with_text(preset_text("tbird")),
        draft.set("terminals.leo_aperture", "7 parsec"),
    ):
        session.other = other
        found = again(session).other
        assert (found.text, found.path, found.problems) == (other.text, other.path, other.problems)
        assert again(session).draft == draft
    session.other = None
    assert again(session).other is None


def test_a_file_that_the_other_mission_came_from_is_read_anew_after_a_restart(session, draft):
    """As long as nothing was changed here."""
    session.other = draft.save(session.inside("wide.toml"))
    changed = draft.set("terminals.leo_aperture", "6 cm").text
    session.inside("wide.toml").write_text(changed, "utf-8")
    assert again(session).other.text == changed
    session.other = session.other.set("terminals.leo_aperture", "7 cm")
    assert again(session).other.values["terminals.leo_aperture"].typed == "7 cm"


@pytest.mark.parametrize("kept", ["", "{", "[]", "[" * 100_000, '{"path": 3, "disk_sha256": "", "text": ""}', "\x00"])
def test_a_damaged_note_of_the_other_mission_is_passed_over(session, draft, kept):
    session.other = draft
    assert again(session).other == draft
    (session.studio / "other.json").write_text(kept, "utf-8")
    assert again(session).other is None


def test_no_link_in_the_studios_folder_is_followed(session, draft, tmp_path_factory):
    session.other = draft
    note = session.studio / "other.json"
    elsewhere = tmp_path_factory.mktemp("elsewhere") / "other.json"
    note.rename(elsewhere)
    note.symlink_to(elsewhere)
    assert again(session).other is None
    note.unlink()
    note.write_bytes(elsewhere.read_bytes())
    assert again(session).other == draft


def test_each_table_of_the_form_is_named_as_in_the_text(draft):
    names = {key.partition(".")[0] for key in draft.values if "." in key}
    assert names == set(re.findall(r"^\[([a-z_]+)", draft.text, re.MULTILINE))


@pytest.mark.parametrize(
    ("here", "there", "change"),
    [
        (Number("m", 3.0, "dB"), Number("m", 5.0, "dB"), "+2 dB"),
        (Number("m", 5.0, "dB"), Number("m", 3.0, "dB"), "-2 dB"),
        (Number("m", 5.0, "dB"), Number("m", 5.0 + 1e-9, "dB"), "same"),
        (Number("m", 0.2, ""), Number("m", 0.9, ""), "+0.7"),
        (Number("m", 0.2, ""), None, ""),
        (None, Number("m", 0.2, ""), ""),
    ],
)
def test_the_change_is_the_second_less_the_first_with_its_sign(here, there, change):
    both = [[each] if each else [] for each in (here, there)]
    ((name, first, second, found),) = compare_view.beside(*both)
    assert name == "m"
    assert found.replace("\u2212", "-").replace(".00", "") == change
    assert (first, second) == tuple("none" if each is None else each.text for each in (here, there))


def test_numbers_stand_in_the_order_of_the_first_then_of_the_second_with_what_is_required():
    met, missed = (Number(name, 1.0, "", "2", passes) for name, passes in (("a", True), ("b", False)))
    rows = compare_view.beside([missed, Number("c", 3.0, "")], [met, missed])
    assert [row[0] for row in rows] == ["b", "c", "a"]
    assert rows[0][1:3] == (Cell("1, required 2", "FAIL"),) * 2
    assert rows[2][1:3] == ("none", Cell("1, required 2", "PASS"))


@pytest.mark.parametrize(("keys", "said"), [(0, compare_view._ABSENT), (1, "1 key"), (2, "2 keys")])
def test_a_table_is_counted_by_its_keys(keys, said):
    assert compare_view._count(keys) == said


def test_a_study_tells_only_requirements_that_have_both_numbers(tmp_path):
    """And it is met where all are, those without numbers, too."""
    row = {"name": "margin", "actual": 4.0, "required": 3.0, "unit": "dB", "met": True}
    without = [row | {"name": "a", "actual": None}, row | {"name": "b", "required": None}]
    for last, met in ((True, True), (False, False)):
        rows = [row, *without, row | {"name": "z", "actual": 1.0, "met": last}]
        found = compare_view._found(tmp_path / "manifest.json", {"requirements": rows, "verdict": "closes"})
        assert (found.folder, found.verdict, found.met) == (tmp_path.name, "closes", met)
        assert [(n.name, n.value, n.unit, n.met) for n in found.numbers] == [
            ("margin", 4.0, "dB", True),
            ("z", 1.0, "dB", last),
        ]
    rows = [row, row | {"name": "a", "actual": None, "met": False}]
    assert not compare_view._found(tmp_path / "manifest.json", {"requirements": rows, "verdict": ""}).met


# ----------------------------------------------------------------------------------------- beside the first of a kind
def test_a_beam_that_misses_zero_decibels_is_told_with_its_own_numbers(draft, monkeypatch):
    study = study_of(2.5)
    study.budgets[1].margin_db = -0.25
    monkeypatch.setattr(compare_view.link_study, "run_link_study", lambda file: study)
    found = [(n.name, n.value, n.unit, n.required, n.met) for n in compare_view.link_numbers(draft)]
    assert found == [
        ("Communication: margin", 2.5, "dB", "3.00 dB", False),
        ("Communication: received power", 1e-9, "W", "", None),
        ("Beacon: margin", -0.25, "dB", "0.00 dB", False),
        ("Beacon: received power", 1e-12, "W", "", None),
        ("Data rate", 3e8, "bit/s", "", None),
        ("Largest data rate with the required margin", 4e8, "bit/s", "", None),
    ]


@pytest.mark.parametrize(
    ("value", "unit", "text"),
    [
        (0.98765432, "", "0.9877"),
        (622.08e6, "bit/s", "622 Mbit/s"),
        (3.14159e-4, "rad", "314 µrad"),
        (12345.678, "", "12350"),
    ],
)
def test_a_number_is_shown_with_its_unit_in_few_digits(value, unit, text):
    assert Number("n", value, unit).text == text


def test_the_change_of_a_number_has_its_unit_and_a_sign_in_front():
    here, there = (
        [Number("r", 622.08e6, "bit/s"), Number("p", 0.25, "")],
        [Number("p", 0.125, ""), Number("r", 1e9, "bit/s")],
    )
    assert compare_view.beside(here, there) == [
        ("r", "622 Mbit/s", "1 Gbit/s", "+378 Mbit/s"),
        ("p", "0.25", "0.125", "−0.125"),
    ]


def test_a_study_says_its_numbers_with_what_was_required_of_each(tmp_path):
    rows = [
        {"name": "rate", "actual": 622.08e6, "required": "300e6", "unit": "bit/s", "met": 1},
        {"name": "error", "actual": 4.5e-6, "required": 1e-5, "unit": "rad", "met": 0},
    ]
    found = compare_view._found(tmp_path / "out" / "manifest.json", {"requirements": rows, "verdict": "no"})
    assert (found.folder, found.verdict, found.met) == ("out", "no", False)
    assert [(n.text, n.required, n.met) for n in found.numbers] == [
        ("622 Mbit/s", "300 Mbit/s", True),
        ("4.5 µrad", "10 µrad", False),
    ]


def test_two_missions_without_a_budget_both_say_why(session, draft):
    here, there = draft.set("terminals.leo_aperture", "5 parsec"), draft.set("terminals.geo_aperture", "6 V")
    links, verdicts, differ = compare_view.blocks(session, here, there, ("a.toml", "b.toml"))
    said = [each.headline for each in links.blocks]
    assert [each.partition("\n")[0] for each in said] == [f"{n} has no link budget:" for n in ("a.toml", "b.toml")]
    assert "parsec" in said[0] and "geo_aperture" in said[1] and "parsec" not in said[1]
    assert [row[0] for row in differ.blocks[1].rows] == ["terminals.leo_aperture", "terminals.geo_aperture"]
    assert len(verdicts.blocks) == 2
    assert [view.title for view in (links, verdicts, differ)] == ["Links", "Verdicts", "Differences"]


def test_the_studies_of_two_missions_stand_beside_each_other_by_their_names(session, draft):
    there = draft.set("terminals.leo_aperture", "6 cm")
    rate = {"name": "rate", "unit": "bit/s", "required": 2e8, "actual": 3e8, "met": True}
    less = {"name": "margin", "unit": "dB", "required": 3.0, "actual": 2.5, "met": False}
    finished(session, draft, "first")
    finished(session, there, "second", verdict="it does not", requirements=[rate, less])
    verdicts = compare_view.blocks(session, draft, there, ("a.toml", "b.toml"))[1]
    ours, theirs, table = verdicts.blocks
    assert (ours.headline, ours.good) == ("a.toml: it closes (first)", True)
    assert (theirs.headline, theirs.good) == ("b.toml: it does not (second)", False)
    assert table.rows == [
        ("margin", Cell("4.00 dB, required 3.00 dB", "PASS"), Cell("2.50 dB, required 3.00 dB", "FAIL"), "−1.50 dB"),
        ("rate", "none", Cell("300 Mbit/s, required 200 Mbit/s", "PASS"), ""),
    ]


@pytest.mark.parametrize(("prefix", "table"), [("beacon", "beacons"), ("channel", "channel_of_mine")])
def test_a_table_whose_name_begins_another_one_is_counted_by_its_own_keys(draft, prefix, table):
    ours, theirs = f"[{prefix}]\nx = 1\ny = 2\n", f"[{table}]\nx = 1\ny = 2\nz = 3\n"
    here, there = draft.with_text(ours), draft.with_text(theirs)
    assert compare_view.differences(here, there) == [
        (f"[{prefix}]", "2 keys", "not given"),
        (f"[{table}]", "not given", "3 keys"),
    ]


@pytest.mark.parametrize(
    ("here", "there", "same"),
    [
        ("[1, 2, 3]", "[1, 3, 2]", False),
        ("true", "true", True),
        ("[true]", "[false]", False),
        ("0.1", "0.10", True),
        ("1_000", "1000", True),
        ("-0.5", "0.5", False),
    ],
)
def test_values_that_mean_the_same_are_no_difference(draft, here, there, same):
    ours, theirs = (draft.with_text(f"[odd]\nx = {each}\n") for each in (here, there))
    assert (compare_view.differences(ours, theirs) == []) == same


def test_a_list_of_quantities_differs_by_its_second_or_by_its_length(draft):
    plain = draft.set("scenario.pid_frequencies", "1 Hz, 15 Hz")
    for typed, same in (
        ("1 Hz, 0.015 kHz", True),
        ("1 Hz, 15.0001 Hz", False),
        ("1 Hz", False),
        ("15 Hz, 1 Hz", False),
    ):
        assert (compare_view.differences(plain, draft.set("scenario.pid_frequencies", typed)) == []) == same


def test_a_free_name_is_the_third_where_a_file_and_a_job_have_two(session, monkeypatch):
    (session.folder / "x.html").touch()
    jobs = [
        Job(1, session.folder, "done", results=("x-4.html",)),
        Job(2, session.folder, "running", results=("other.html", "x-2.html")),
        Job(3, session.folder, "queued", results=("x-3/report.html", "x-5.html")),
    ]
    monkeypatch.setattr(session.jobs, "listed", lambda: tuple(jobs))
    assert runs_view.free_name(session, "x", ".html") == "x-3.html"
    assert runs_view.free_name(session, "x-3") == "x-3-2"
    assert runs_view.free_name(session, "other", ".html") == "other-2.html"
    assert runs_view.free_name(session, "y") == "y"


def test_a_second_example_of_a_campaign_gets_a_name_of_its_own_and_a_quoted_mission(session):
    (session.folder / "campaign.toml").write_text("mine", "utf-8")
    odd = session.folder / 'my "µ" mission.toml'
    session.save(odd.name)
    path = runs_view.write_campaign(session)
    assert path == session.folder / "campaign-2.toml"
    assert tomllib.loads(path.read_text("utf-8"))["mission"] == odd.name
    assert "µ" in path.read_text("utf-8")
    assert (session.folder / "campaign.toml").read_text("utf-8") == "mine"
    assert runs_view.campaign_files(session) == ("campaign-2.toml",)


def test_a_campaign_of_a_mission_that_is_not_saved_is_refused_by_its_name(tmp_path):
    fresh = Session(tmp_path)
    with pytest.raises(JobError) as refusal:
        runs_view.write_campaign(fresh)
    assert str(refusal.value) == ("leo-geo.toml is not saved yet, and a campaign reads it from its file; save it")
    assert runs_view.campaign_files(fresh) == ()


def test_the_report_of_a_ledger_goes_beside_a_page_that_is_there(session):
    (session.folder / "tails.v2.html").touch()
    order = runs_view.report_order(session, Path("tails.v2.ledger"))
    assert (order.kind, order.title, order.cwd) == ("export", "Report of tails.v2.ledger", session.folder)
    assert order.arguments == ("campaign", "report", "tails.v2.ledger", "tails.v2-2.html", "--overwrite")
    assert order.results == ("tails.v2-2.html",)


@pytest.mark.parametrize(
    ("progress", "words"),
    [
        (Progress(37, 1600, "rows", 12.5), "2.3 %, 37 of 1600 rows; 12.5 a second, 2.08 min left"),
        (Progress(90, 120, "tuning LQG", 0.00625), "75 %, 90 of 120: tuning LQG; 0.00625 a second, 80 min left"),
        (Progress(160, 1600, "rows", 1234.5), "10 %, 160 of 1600 rows; 1230 a second, 1.17 s left"),
        (Progress(1600, 1600, "rows", 234.7), "100 %, 1600 of 1600 rows; 235 a second, 0 s left"),
        (Progress(7, 0, "links"), "0 %, 7 of 0: links"),
    ],
)
def test_progress_has_its_share_its_pace_and_what_is_left(progress, words):
    assert runs_view.progress_words(progress) == words


@pytest.mark.parametrize(
    ("kind", "code", "state", "words"),
    [
        ("campaign", 0, "done", "done: the rows keep the limits"),
        ("identification", 0, "done", "done"),
        ("study", 2, "failed", "failed"),
        ("study", None, "done", "done"),
        ("campaign", 1, "cancelled", "cancelled"),
        ("study", 0, "unreadable", "unreadable"),
    ],
)
def test_only_a_job_that_is_done_has_a_verdict(tmp_path, kind, code, state, words):
    assert runs_view.state_words(Job(1, tmp_path, state, kind, code=code, cancelling=True)) == words


def test_results_keep_their_places_among_those_that_are_gone(session):
    for name in ("b.nc", "d.json"):
        (session.folder / name).touch()
    (session.folder / "c.html").mkdir()
    job = Job(5, session.folder, "done", cwd=session.folder, results=("a.html", "b.nc", "c.html", "d.json"))
    assert runs_view.result_files(session, job) == ((1, "b.nc"), (3, "d.json"))
    assert runs_view.result_files(session, replace(job, state="lost")) == ((1, "b.nc"), (3, "d.json"))


def test_the_report_of_another_kind_of_job_is_none_of_a_campaign(tmp_path):
    done = campaign(tmp_path, 1, ledger="-x.ledger")
    (tmp_path / "x.html").touch()
    written = report(tmp_path, 2, ledger="-x.ledger")
    assert runs_view.others((written, done), done) == runs_view.Others(True, True, written)
    verify = replace(written, arguments=("campaign", "verify", "./-x.ledger"))
    assert runs_view.others((verify, done), done).report is None
    assert runs_view.others((replace(written, number=1), done), done).report is None


@pytest.mark.parametrize("zone", ["", "Z", "+00:00"])
def test_a_time_without_a_zone_is_one_of_utc(tmp_path, zone):
    job = Job(1, tmp_path, "done", started=f"2026-01-02T03:04:05{zone}", ended="2026-01-02T05:04:35+02:00")
    assert runs_view.time_words(job) == "started 2026-01-02 03:04:05 UTC, 30 s"
    assert runs_view.time_words(replace(job, ended="")).startswith("started 2026-01-02 03:04:05 UTC, ")


def test_a_time_of_another_zone_is_told_in_utc(tmp_path):
    job = Job(1, tmp_path, "queued", queued="2026-01-02T03:04:05+02:00")
    assert runs_view.time_words(job) == "put in the queue 2026-01-02 01:04:05 UTC"
    assert runs_view.time_words(replace(job, queued="0001-01-01T00:00:00+02:00")) == "put in the queue "


@pytest.mark.parametrize("number", ["1" + 400 * "0", 100_000 * "["])
def test_a_folder_of_another_program_is_no_study(session, draft, number):
    path = finished(session, draft, "mine")
    text = path.read_text("utf-8").replace('"actual": 4.0', f'"actual": {number}')
    (session.folder / "other").mkdir()
    (session.folder / "other" / "manifest.json").write_text(text, "utf-8")
    assert number in text and compare_view.finished_study(session, draft).folder == "mine"


UNLIKE = {
    "communication.data_rate": ("622.08 Mbit/s", "1.25 Gbit/s"),
    "communication.pointing_error": ("7.3 urad", "5.5 urad"),
    "beacon.divergence": ("780 urad", "512.5 urad"),
    "requirement.margin": ("1.7 dB", "2.25 dB"),
    "name": ("one", "two"),
}
BESIDE = """
View Links
  Table
  | number | in a.toml | in b.toml (saved) | change = 0
  | Communication: margin | 0.87 dB, required 1.70 dB FAIL | −1.82 dB, required 2.25 dB FAIL | −2.69 dB
  | Communication: received power | 28.4 nW | 30.7 nW | +2.29 nW
  | Beacon: margin | 6.30 dB, required 0.00 dB PASS | 3.01 dB, required 0.00 dB PASS | −3.29 dB
  | Beacon: received power | 42.7 pW | 20 pW | −22.7 pW
  | Answer: margin | 9.51 dB, required 0.00 dB PASS | 9.51 dB, required 0.00 dB PASS | same
  | Answer: received power | 893 pW | 893 pW | same
  | Data rate | 622 Mbit/s | 1.25 Gbit/s | +628 Mbit/s
  | Largest data rate with the required margin | 405 Mbit/s | 342 Mbit/s | −62.4 Mbit/s
  | Open-loop pointing error, root sum square | 390 µrad | 390 µrad | same
  | Acquisition by the wide beacon: probability | 0.9985 | 2.863e-12 | −0.9985
  | Acquisition by the wide beacon: mean time | 20.3 s | none |
View Verdicts
  Soft a.toml: no study of this text is in the folder; the page Runs makes one.
  Verdict b.toml (saved): 1 of 2 requirements is missed (b-study) False
  Table
  | number | in a.toml | in b.toml (saved) | change = 0
  | margin | none | 1.31 dB, required 1.70 dB FAIL |
  | residual | none | 7.25 µrad, required 10 µrad PASS |
View Differences
  6 keys differ; a table that one of them lacks is one.
  Table
  | key | in a.toml | in b.toml (saved) = 0
  | name | one | two
  | beacon.divergence | 780 urad / paper: section 2.1 | 512.5 urad / mission file, line 57, in place of 780 urad \
(paper: section 2.1)
  | communication.pointing_error | 7.3 urad / mission file, line 81, in place of 10 urad (paper: Table 2 and \
section 2.2) | 5.5 urad / mission file, line 82, in place of 10 urad (paper: Table 2 and section 2.2)
  | communication.data_rate | 622.08 Mbit/s / mission file, line 83, in place of 300 Mbit/s (paper: section 2.2) | \
1.25 Gbit/s / mission file, line 84, in place of 300 Mbit/s (paper: section 2.2)
  | requirement.margin | 1.7 dB / mission file, line 92, in place of 3 dB (paper: section 2.2) | 2.25 dB / mission \
file, line 93, in place of 3 dB (paper: section 2.2)
  | terminals.geo_obscuration | not given | 0.2
"""


def test_two_unlike_missions_are_compared_in_all_their_numbers_studies_and_keys(session, draft):
    here, there = draft, draft.set("terminals.geo_obscuration", "0.2")
    for key, (one, other) in UNLIKE.items():
        here, there = here.set(key, one), there.set(key, other)
    requirements = [
        {"name": "margin", "actual": 1.31, "required": 1.7, "unit": "dB", "met": False},
        {"name": "residual", "actual": 7.25e-6, "required": 10e-6, "unit": "rad", "met": True},
    ]
    finished(session, there, "b-study", verdict="1 of 2 requirements is missed", requirements=requirements)
    found = compare_view.blocks(session, here, there, ("a.toml", "b.toml (saved)"))
    assert [line.replace("| -", "| −") for line in block_lines(found)] == BESIDE.strip().splitlines()


@pytest.mark.parametrize(
    ("here", "there", "names", "words"),
    [
        ("5 parsec", "5 cm", ("a", "b"), ["a has no link budget:"]),
        ("5 cm", "6 parsec", ("a", "b"), ["b has no link budget:"]),
    ],
)
def test_a_mission_without_a_budget_stands_beside_the_numbers_of_the_other(session, draft, here, there, names, words):
    key = "terminals.leo_aperture"
    (links, *_) = compare_view.blocks(session, draft.set(key, here), draft.set(key, there), names)
    fault, table = links.blocks
    assert [fault.headline.splitlines()[0]] == words and "parsec" in fault.headline and fault.good is False
    absent = 1 if "parsec" in here else 2
    assert {row[absent] for row in table.rows} == {"none"} and {row[3] for row in table.rows} == {""}
    assert "none" not in {row[3 - absent] for row in table.rows}
    assert table.headings == ("number", "in a", "in b", "change")


@pytest.mark.parametrize(
    ("kind", "state", "code", "words"),
    [
        ("study", "done", 0, "done: every requirement is met"),
        ("study", "done", 1, "done: not every requirement is met"),
        ("campaign", "done", 0, "done: the rows keep the limits"),
        ("campaign", "done", 1, "done: the rows do not keep the limits"),
        ("identification", "done", 0, "done"),
        ("export", "done", 1, "done"),
        ("campaign", "done", None, "done"),
        ("study", "failed", 1, "failed"),
        ("campaign", "cancelled", 0, "cancelled"),
        ("study", "unreadable", None, "unreadable"),
        ("campaign", "running", 0, "running"),
    ],
)
def test_a_job_of_each_kind_says_what_was_found(tmp_path, kind, state, code, words):
    assert runs_view.state_words(Job(1, tmp_path, state, kind, code=code)) == words


@pytest.mark.parametrize(
    ("done", "total", "what", "words"),
    [
        (0, 7, "rows", "0 %, 0 of 7 rows"),
        (1, 2000, "rows", "0.1 %, 1 of 2000 rows"),
        (99, 1000, "12.5 rows/s", "9.9 %, 99 of 1000 rows"),
        (199, 2000, "rows", "10 %, 199 of 2000 rows"),
        (1999, 2000, "draws", "99 %, 1999 of 2000: draws"),
        (2000, 2000, "draws", "100 %, 2000 of 2000: draws"),
        (3, 0, "links", "0 %, 3 of 0: links"),
    ],
)
def test_a_share_is_told_beside_what_it_is_a_share_of(done, total, what, words):
    assert runs_view.progress_words(Progress(done, total, what)) == words


@pytest.mark.parametrize(
    ("seconds", "took"), [(0, "0 s"), (1, "1 s"), (90, "90 s"), (3600, "60 min"), (7200, "2 h"), (-5, "0 s")]
)
def test_how_long_a_job_took_or_takes_is_told_behind_its_start(tmp_path, seconds, took):
    now = datetime(2026, 3, 20, 12, 0, 0, tzinfo=UTC) + timedelta(seconds=seconds)
    job = Job(1, tmp_path, "done", queued="2026-03-19T00:00:00Z", started="2026-03-20T12:00:00Z")
    words = f"started 2026-03-20 12:00:00 UTC, {took}"
    assert runs_view.time_words(job, lambda: now) == words
    ended = replace(job, ended=now.isoformat())
    assert runs_view.time_words(ended, lambda: datetime(2030, 1, 1, tzinfo=UTC)) == words


@pytest.mark.parametrize(
    ("here", "there", "unit", "row"),
    [
        (300e6, 300.4e6, "bit/s", ("300 Mbit/s", "300.4 Mbit/s", "+400 kbit/s")),
        (3.001, 3.004, "dB", ("3.001 dB", "3.004 dB", "+0.003 dB")),
        (3.004, 3.001, "dB", ("3.004 dB", "3.001 dB", "−0.003 dB")),
        (0.91234, 0.91233, "", ("0.91234", "0.91233", "−1e-05")),
        (3e8, 3e8 * (1.0 + 1e-9), "bit/s", ("300 Mbit/s", "300 Mbit/s", "same")),
        (math.inf, math.inf, "s", ("inf s", "inf s", "same")),
    ],
)
def test_numbers_that_differ_in_a_later_digit_are_told_apart(here, there, unit, row):
    assert compare_view.beside([Number("n", here, unit)], [Number("n", there, unit)]) == [("n", *row)]


def test_what_is_required_stands_behind_a_number_that_is_told_apart():
    one, other = (Number("n", value, "W", "1 W", True) for value in (2.0001, 2.0002))
    ((_, *cells, change),) = compare_view.beside([one], [other])
    assert cells == [Cell("2.0001 W, required 1 W", "PASS"), Cell("2.0002 W, required 1 W", "PASS")]
    assert change == "+100 µW"


def test_a_margin_that_no_rate_has_leaves_the_largest_rate_out(draft):
    far = compare_view.link_numbers(draft.set("requirement.margin", "90 dB"))
    rows = {row[0]: row[1:] for row in compare_view.beside(compare_view.link_numbers(draft), far)}
    assert rows[RATES[1]][1:] == ("none", "") and "nan" not in str(rows)


@pytest.mark.parametrize(
    ("text", "there"),
    [
        ('channel.elevation = "30 deg"\n', "channel"),
        ('\ufeffchannel = { elevation = "30 deg" }\n', "channel"),
        ('[fine_pointing]\nwheels.speed = "50 Hz"\n', "fine_pointing.wheels"),
        ('fine_pointing = { rate = "5 kHz" }\n', "fine_pointing.wheels"),
    ],
)
def test_a_table_that_stands_in_keys_is_not_offered_nor_one_within_such_a_table(draft, text, there):
    found = draft.with_text(text)
    assert there not in offered(found) and "jitter" in offered(found)
    with pytest.raises(DraftError, match=r"cannot be added: it is there already"):
        with_table(found, there)


EXAMPLE = '# [channel]\r\n# elevation = "30 deg"\n'


@pytest.mark.parametrize(
    "text", [f"{EXAMPLE}[b]\r\n", f"a = 1\n\r\n{EXAMPLE}", f"\ufeff{EXAMPLE}[b]\n", f"\ufeff{EXAMPLE}"]
)
def test_an_example_comes_to_life_and_no_line_end_nor_mark_changes(draft, text):
    assert with_table(replace(draft, text=text), "channel").text == text.replace("# ", "")


def test_an_example_at_the_end_of_lines_of_both_kinds_changes_none_of_them(draft):
    text = "a = 1\r\nb = 2\n[c]"
    added = with_table(replace(draft, text=text), "channel").text.removeprefix(f"{text}\r\n\r\n")
    assert added.startswith("[channel]\r\n") and added.count("\n") == added.count("\r\n") > 1


def test_a_campaign_file_that_cannot_be_looked_at_names_no_mission(session):
    path = session.folder / "c.toml"
    path.write_text('mission = "mission.toml"\n', encoding="utf-8")
    assert runs_view._names_a_mission(path) and not runs_view._names_a_mission(session.folder / "gone.toml")


@pytest.mark.parametrize(
    ("text", "time_s"), [('version = "m.toml"\n', 2e9), ('versions = "m.toml"\n', 1e9), ("# version 3", 3e9)]
)
def test_a_campaign_file_that_becomes_another_is_read_anew(session, text, time_s):
    """Of the same size at another time, of another size at the same time, and of both."""
    path = session.folder / "c.toml"
    for content, seconds, names in (('mission = "m.toml"\n', 1e9, True), (text, time_s, False)):
        path.write_text(content, "utf-8")
        os.utime(path, (seconds, seconds))
        assert runs_view._names_a_mission(path) is names
    assert runs_view.campaign_files(session) == ()


def test_manifests_of_other_programs_are_passed_over_whatever_they_hold(session, draft):
    """Each alone would be of this text; the one that can be read is found behind all of them."""
    good = json.loads(finished(session, draft, "study").read_text("utf-8"))
    mission, summary = good["mission"], good["summary"]
    (row,) = summary["requirements"]
    odd = [
        *([], 3, None, "text", {}, {"mission": None}, {"mission": [mission]}, {"mission": mission}),
        *({"mission": mission, "summary": each} for each in (None, [summary], {"requirements": [row]})),
        *(
            {"mission": mission, "summary": summary | {"requirements": each}}
            for each in (
                None,
                7,
                [None],
                [row | {"actual": "x"}],
                [row | {"required": []}],
                [{**row, "unit": "dB2"}, 1],
            )
        ),
    ]
    written = [json.dumps(each).encode() for each in odd] + [b"", b"\xff", b"{", b"\x00"]
    for number, content in enumerate(written):
        (session.folder / f"odd-{number}").mkdir()
        (session.folder / f"odd-{number}" / "manifest.json").write_bytes(content)
    (session.folder / "folder" / "manifest.json").mkdir(parents=True)
    (session.folder / "loop").mkdir()
    (session.folder / "loop" / "manifest.json").symlink_to("manifest.json")
    found = compare_view.finished_study(session, draft)
    assert (found.folder, found.verdict, found.met) == ("study", "it closes", True)


def test_of_too_many_folders_the_first_by_their_names_are_looked_into(session, draft, monkeypatch):
    monkeypatch.setattr(compare_view, "_MOST_FOLDERS", 2)
    paths = {name: finished(session, draft, name, verdict=f"of {name}") for name in ("c", "a", "d", "b")}
    for name, seconds in zip("dcab", (4e9, 3e9, 1e9, 2e9), strict=True):
        os.utime(paths[name], (seconds, seconds))
    asked = []
    folder = SimpleNamespace(glob=lambda pattern: asked.append(pattern) or paths.values())
    found = compare_view.finished_study(SimpleNamespace(folder=folder), draft)
    assert (found.folder, found.verdict, asked) == ("b", "of b", ["*/manifest.json"])


@pytest.mark.parametrize("error", [OSError(40, "Too many levels of symbolic links"), RuntimeError("Symlink loop")])
def test_a_result_whose_place_cannot_be_told_is_not_offered(session, monkeypatch, error):
    (session.folder / "x.ledger").touch()
    job = campaign(session.folder, 1)
    assert runs_view.ledger_path(session, job) == session.folder / "x.ledger"

    def refuse(path, strict=False):
        raise error

    monkeypatch.setattr(Path, "resolve", refuse)
    assert (runs_view.ledger_path(session, job), runs_view.result_files(session, job)) == (None, ())


def test_a_campaign_file_that_is_taken_away_as_it_is_read_names_no_mission(session, monkeypatch):
    for name in ("a.toml", "b.toml"):
        (session.folder / name).write_text('mission = "mission.toml"\n', "utf-8")
    read = runs_view.read_bytes

    def gone(path, most):
        if path.name == "a.toml":
            raise FileNotFoundError(2, "No such file or directory")
        return read(path, most)

    monkeypatch.setattr(runs_view, "read_bytes", gone)
    assert runs_view.campaign_files(session) == ("b.toml",)
