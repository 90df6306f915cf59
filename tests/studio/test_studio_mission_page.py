"""The mission page and the frame of each page as the server builds them, without a browser."""

import asyncio
import os
import threading
from pathlib import Path
from types import SimpleNamespace

import pytest

from microrad.studio import commands
from microrad.studio.draft import draft as drafts
from microrad.studio.draft.draft import Draft, DraftError
from microrad.studio.guard.names import NameRefusedError
from microrad.studio.jobs.queue import Job
from microrad.studio.session import Session
from microrad.studio.views import runs as runs_view
from shipped import SHIPPED

pytest.importorskip("nicegui", reason="the studio is not installed (nicegui)")

from nicegui.client import Client
from nicegui.page import page as at

from microrad.studio.pages import compare, layout, mission, runs, runs_jobs
from microrad.studio.pages.sliders import SliderPage
from waiting import until

LEO, GEO = "terminals.leo_aperture", "terminals.geo_aperture"
TEXT = SHIPPED.read_text("utf-8")


@pytest.fixture
def session(tmp_path):
    """The paper's mission, saved."""
    (tmp_path / "leo-geo.toml").write_text(TEXT, "utf-8")
    return Session(tmp_path)


@pytest.fixture
def opened(session):
    """Opens tabs on the mission page, at the table of the terminals."""
    clients = []

    def enter():
        clients.append(Client(at("/"), request=None))
        with clients[-1]:
            found = mission._Page(session)
            found.form.show("terminals")
        return found

    yield enter
    for client in clients:
        client.delete()


@pytest.fixture
def told(monkeypatch):
    """What pages refuse, in words."""
    words = []
    monkeypatch.setattr(layout, "refuse", words.append)
    monkeypatch.setattr(mission, "_ask", lambda title, *_: words.append(title))
    return words


def test_a_folder_without_a_mission_has_none_to_open(session, told):
    mission._open(session, told.append)
    (session.folder / "leo-geo.toml").unlink()
    mission._open(session, told.append)
    assert told == [
        f"Open a mission in {session.folder}",
        f"There is no TOML file in {session.folder} yet; save this mission there first.",
    ]


def test_a_mission_with_every_table_gets_no_other_one(session, told, monkeypatch):
    mission._add_table(session, told.append)
    monkeypatch.setattr(mission, "offered", lambda draft: [])
    mission._add_table(session, told.append)
    assert told == [
        "Add a table, with example values to be changed",
        "This mission has every table that there is an example of.",
    ]


def test_a_budget_of_two_missions_needs_both_in_files(session, told):
    page = SimpleNamespace(session=session)
    assert compare._Page._action(page, True) is None
    session.other = Draft.shipped(session.folder / "other.toml")
    assert compare._Page._action(page, True) is None
    assert told == [
        "There is no other mission yet; choose one.",
        "other.toml is not a file of this folder yet; save it there first.",
    ]
    session.other = Draft.open(session.folder / "leo-geo.toml")
    assert compare._Page._action(page, True) == commands.budget(Path("leo-geo.toml"))


def edited(page, text):
    """What the page does when its editor says that it has another text."""
    with page.section:
        page._text(SimpleNamespace(value=text))


def field(page, key):
    return page.form._rows[key].field.value


# ------------------------------------------------------------------------------------------------------ lose no work
def test_the_editor_cannot_undo_its_way_from_one_mission_into_another(session, opened):
    page, other = opened(), opened()
    before, others = page.editor, other.editor
    session.set(LEO, "6 cm")
    page._all()
    assert page.editor is before  # the change of another tab can be undone
    session.folder.joinpath("b.toml").write_text(TEXT.replace('"5 cm"', '"7 cm"'), "utf-8")
    session.replace(Draft.open(session.inside("b.toml")))
    edited(page, page.editor.value + "# of the first mission\n")
    assert "of the first" not in session.draft.text
    assert page.editor is not before
    other._all()
    assert before.is_deleted
    assert others.is_deleted
    assert page.editor.value == other.editor.value == session.draft.text
    assert '"7 cm"' in page.editor.value


@pytest.mark.promise("studio-12")
def test_a_mission_that_was_never_saved_is_not_dropped_without_a_word(tmp_path):
    session = Session(tmp_path)
    assert mission._lost(session) == ""  # as it began: it can be begun again
    session.set(LEO, "6 cm")
    assert mission._lost(session) == "leo-geo.toml is not on disk and will be lost; save it first to keep it."
    session.save()
    assert mission._lost(session) == ""
    session.set(LEO, "7 cm")
    assert mission._lost(session) == "Changes that are not saved will be lost."
    session.save()
    (tmp_path / "leo-geo.toml").unlink()
    assert "will be lost" in mission._lost(session)


def test_a_change_of_another_thread_is_not_lost_by_saving(session, monkeypatch):
    session.set(LEO, "6 cm")
    other, real = threading.Thread(target=session.set, args=(GEO, "16 cm")), session._lock
    waits = threading.Event()

    class Lock:
        def __enter__(self):
            if threading.current_thread() is other:
                waits.set()
            real.acquire()

        def __exit__(self, *_):
            real.release()

    def slow(path, text, mode, write=drafts.write_whole):
        write(path, text, mode=mode)
        other.start()
        until(lambda: waits.is_set() or not other.is_alive(), "the other thread at the lock")

    monkeypatch.setattr(session, "_lock", Lock())
    monkeypatch.setattr(drafts, "write_whole", slow)
    session.save()
    other.join()
    assert session.draft.values[GEO].typed == "16 cm"
    assert session.draft.changed
    assert '"6 cm"' in session.draft.path.read_text("utf-8")
    assert '"16 cm"' not in session.draft.path.read_text("utf-8")


@pytest.mark.promise("studio-11")
def test_two_tabs_show_what_the_other_sets_also_when_both_set_at_once(session, opened):
    one, two = opened(), opened()
    one.form._typed(LEO, "6 cm")
    two.form._typed(GEO, "16 cm ")
    assert (field(two, LEO), two.form._rows[GEO].typed) == ("6 cm", "16 cm ")  # what is typed stays as it is
    assert two.editor.value == session.draft.text
    assert '"6 cm"' in two.editor.value


def test_a_text_that_is_behind_takes_nothing_back(session, opened):
    one, two = opened(), opened()
    one.form._typed(LEO, "6 cm")
    edited(two, two.editor.value + "# typed\n")
    assert session.draft.values[LEO].typed == field(two, LEO) == "6 cm"
    assert two.editor.value == session.draft.text
    edited(two, two.editor.value + "# typed\n")
    assert session.draft.text.endswith("# typed\n")
    assert session.draft.values[LEO].typed == "6 cm"


def test_a_slider_that_is_let_go_is_written_before_anything_else_is_done(session):
    page = SliderPage.__new__(SliderPage)
    page.session, page._busy = session, True  # with the answer to what was tried before
    page._faults = SimpleNamespace(is_deleted=False)

    async def let_go():
        writing = asyncio.create_task(page._set(LEO, "6 cm"))
        saving = asyncio.create_task(asyncio.to_thread(session.save))  # by the same click
        await saving
        writing.cancel()

    asyncio.run(let_go())
    assert '"6 cm"' in session.draft.path.read_text("utf-8")


# ------------------------------------------------------------------------------------------------------ too many keys
def test_a_mission_of_thousands_of_keys_has_some_rows_and_says_so(session, opened):
    keys = "".join(f"k{n} = 1\n" for n in range(20_000))
    tables = "".join(f"[t{n}]\nx = 1\n" for n in range(900))
    session.change(session.draft.with_text(keys + session.draft.text + tables))
    page = opened()
    with page.section:
        page._show("general")
    assert len(page.form._rows) == 300
    said = [each.text for each in page.form._place.descendants() if "Only the first" in getattr(each, "text", "")]
    assert said == [
        'Only the first 300 of 20001 keys have a row here; look for others with "Find a key", or change them in the '
        "text."
    ]
    assert len(page.entries) == 50
    assert len(page.section.client.elements) < 5000
    with page.section:
        page.form.show("general", "k19999")
    assert list(page.form._rows) == ["k19999"]


def test_many_faults_are_counted_and_the_first_are_listed(session, opened):
    session.change(session.draft.with_text(session.draft.text + "".join(f"k{n} = 1\n" for n in range(70))))
    listed = [getattr(each, "text", "") for each in opened().faults.descendants()]
    assert "70 faults to correct" in listed
    assert "and 20 more" in listed
    assert sum(text.startswith("line ") for text in listed) == 50


# ----------------------------------------------------------------------------------------------------- changed on disk
@pytest.mark.promise("studio-11")
def test_a_file_that_another_program_changes_is_told(session):
    path, revision = session.draft.path, session.revision
    assert (session.disk, session.disk_words(), layout._words(session.draft, session.disk)) == ("", "", "saved")
    path.write_text(TEXT.replace('"5 cm"', '"12 cm"'), "utf-8")
    assert session.disk == "changed"
    assert session.revision == revision + 1  # so every page shows it
    assert session.disk_words() == (
        "leo-geo.toml was changed on disk by another program since it was opened here; open it again "
        '("Back to the saved file" on the page Mission), or save this text under another name'
    )
    assert layout._words(session.draft, "changed") == "changed on disk; open it again"
    session.set(LEO, "x")
    told = layout._words(session.draft, session.disk)
    assert told == "not saved, 1 fault to correct, changed on disk; open it again"
    session.reopen()
    assert session.draft.values[LEO].typed == "12 cm"
    assert (session.disk, session.disk_words()) == ("", "")
    assert layout._words(session.draft, session.disk) == "saved"


def test_a_file_that_another_program_removes_is_told_and_can_be_saved_again(session):
    session.draft.path.unlink()
    assert (session.disk, session.disk_words()) == ("gone", "leo-geo.toml is not on disk any more; save it again")
    assert layout._words(session.draft, session.disk) == "not saved, gone from disk"
    session.save()
    assert session.disk == ""
    assert session.draft.path.read_text("utf-8") == TEXT


def test_the_same_text_written_again_and_a_draft_that_is_not_saved_are_no_change_on_disk(session):
    session.set(LEO, "6 cm")
    assert session.disk == ""
    session.draft.path.write_text(TEXT, "utf-8")
    assert session.disk == ""
    session.draft.path.write_text(session.draft.text, "utf-8")
    assert session.disk == ""
    session.save()
    assert not session.draft.changed


def test_what_is_no_file_any_more_is_not_read(session):
    session.draft.path.unlink()
    os.mkfifo(session.draft.path)  # reading it would never end
    assert session.disk == "changed"


@pytest.mark.promise("studio-11")
def test_a_study_of_a_file_that_another_program_has_changed_is_not_run(session, monkeypatch):
    asked = []
    monkeypatch.setattr(runs, "submit", lambda *order: asked.append(order))
    client = Client(at("/"), request=None)
    with client:
        study = runs._Study(session)
        study.folder.value = "found"
        session.draft.path.write_text(TEXT.replace('"5 cm"', '"6 cm"', 1), "utf-8")
        asyncio.run(study._run())
        study._look()
    assert asked == [] and not study.button.enabled
    assert study.fault.text == session.disk_words() != ""
    session.reopen()
    with client:
        study._look()
    assert study.button.enabled and study.fault.text == ""
    client.delete()


@pytest.mark.promise("studio-17")
def test_a_campaign_that_was_cancelled_goes_on_and_one_that_is_done_gets_its_report(session, monkeypatch):
    asked = []

    async def here(page, work, *args):
        return work(*args)

    async def clicked():
        with client:
            for job, click in ((stopped, "_go_on"), (done, "_write_page")):
                card = runs_jobs._Card(jobs, job)
                await card.show(job, runs_view.others((job,), job))
                assert (card.again.visible, card.page.visible) == (job is not done, job is done)
                await getattr(card, click)()

    monkeypatch.setattr(runs_jobs, "in_thread", here)
    monkeypatch.setattr(session.jobs, "submit", asked.append)
    monkeypatch.setattr(session.jobs, "output", lambda number: "said")
    (session.folder / "x.ledger").touch()
    more = {"arguments": ("campaign",), "cwd": session.folder, "results": ("x.ledger",)}
    stopped, done = (Job(1, session.folder, state, "campaign", **more) for state in ("cancelled", "done"))
    client = Client(at("/"), request=None)
    with client:
        jobs = runs_jobs.JobList(session, lambda address, title: None)
    asyncio.run(clicked())
    client.delete()
    assert [order.arguments for order in asked] == [
        commands.resume(Path("x.ledger")).arguments,
        commands.campaign_report(Path("x.ledger"), Path("x.html")).arguments,
    ]


@pytest.mark.parametrize("content", [TEXT, None])
def test_nothing_is_saved_through_a_link_that_has_come_in_the_files_place(session, tmp_path_factory, content):
    outside = tmp_path_factory.mktemp("outside") / "mine.toml"
    if content is not None:
        outside.write_text(content, "utf-8")
    session.draft.path.unlink()
    session.draft.path.symlink_to(outside)
    session.set(LEO, "6 cm")
    with pytest.raises(DraftError, match=r"leo-geo\.toml is or lies behind a link to .*mine\.toml now, which it was"):
        session.save()
    with pytest.raises(NameRefusedError, match="is outside of"):
        session.reopen()
    assert not outside.exists() if content is None else outside.read_text("utf-8") == content
    session.save("other.toml")
    assert '"6 cm"' in session.inside("other.toml").read_text("utf-8")
