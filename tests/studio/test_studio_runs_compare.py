"""What the studio's pages of the mission, of runs and of comparisons show, without a browser."""

import json
import os
import re
import tomllib
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import pytest

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
def session(tmp_path):
    (tmp_path / "leo-geo.toml").write_bytes(SHIPPED.read_bytes())
    return Session(tmp_path)


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
