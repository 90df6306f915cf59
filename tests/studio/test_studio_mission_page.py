"""The mission page and the frame of each page as the server builds them, without a browser."""

import asyncio
import os
import threading
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from unittest.mock import MagicMock

import pytest

from microrad.mission.presets import preset_text
from microrad.mission.toml import Fault
from microrad.studio import commands
from microrad.studio.draft import draft as drafts
from microrad.studio.draft.draft import Draft, DraftError
from microrad.studio.draft.keys import key_of
from microrad.studio.guard.names import NameRefusedError
from microrad.studio.jobs.queue import Job
from microrad.studio.session import Session
from microrad.studio.views import runs as runs_view
from shipped import SHIPPED

pytest.importorskip("nicegui", reason="the studio is not installed (nicegui)")

from nicegui import ui
from nicegui.client import Client
from nicegui.page import page as at

from microrad.studio.pages import compare, layout, mission, mission_form, runs, runs_jobs
from microrad.studio.pages.sliders import SliderPage
from studio_pages import buttons, here, outline, press, texts
from waiting import until

LEO, GEO = "terminals.leo_aperture", "terminals.geo_aperture"
TEXT = SHIPPED.read_text("utf-8")


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


def test_the_command_that_is_copied_is_of_the_mission_that_is_open_then(session, opened, monkeypatch):
    copied = []
    monkeypatch.setattr(layout, "copy_buttons", copied.append)
    opened()
    session.save("other.toml")
    assert copied[0]().arguments == ("budget", "other.toml")


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


# ------------------------------------------------------------------------------------------------------ the form's rows
@pytest.fixture
def tab():
    """A page that elements are put on."""
    client = Client(at("/"), request=None)
    with client:
        yield client
    client.delete()


def test_keys_are_counted_to_their_outermost_tables_with_their_faults(session):
    assert [mission_form.table_of(key) for key in ("name", "a.b", "a.b.c")] == ["general", "a", "a"]
    draft = session.draft.with_text('name = "x"\n[terminals]\nleo_aperture = 5\n[empty]\n[later]\nx = 1\n')
    found = mission_form.tables(draft)
    assert list(found)[:3] == ["general", "terminals", "later"]
    assert found["terminals"] >= 1 and found["later"] == 1
    assert sum(found.values()) == len(draft.problems)
    assert mission_form.tables(session.draft) == dict.fromkeys(mission_form.tables(session.draft), 0)


@pytest.mark.parametrize(
    ("nearest", "words"), [("", "is unknown; expected: a key"), ("b", "is unknown; did you mean b? expected: a key")]
)
def test_a_fault_names_the_key_that_it_resembles(nearest, words):
    assert mission_form.fault_words(Fault("a", "1", 3, "is unknown", "a key", nearest)) == words


def test_a_key_is_looked_for_in_name_value_and_comment_and_none_may_have_the_text(opened):
    page = opened()
    for sought, keys in ((" LEO_Aperture ", [LEO]), ("paper: table 2", None), ("5 cm", None), ("nowhere", [])):
        with page.section:
            page.form.show("terminals", sought)
        assert page.form.sought == sought.strip().lower()
        assert LEO in page.form._rows if keys is None else list(page.form._rows) == keys
        assert ("No key has this text." in texts(page.form._place)) == (keys == [])
        assert "Another key" not in [each.props.get("label") for each in page.form._place.descendants()]
    with page.section:
        page.form.show("no_table")
    assert texts(page.form._place) == ["This table has no keys of its own."]
    with page.section:
        page.form.show("orbit")
    assert [text for text in texts(page.form._place) if text.startswith("[")][:2] == ["[orbit]", "[orbit.leo]"]
    with page.section:
        page.form.show("general")
    assert "General" in texts(page.form._place)


def test_a_row_that_does_not_match_any_more_stays_while_its_key_is_typed(session, opened):
    page = opened()
    with page.section:
        page.form.show("terminals", "5 cm")
        before = dict(page.form._rows)
        assert {LEO, GEO} <= set(before)
        page.form._typed(LEO, "6 cm")
    assert session.draft.values[LEO].typed == "6 cm"
    assert page.form._rows == before
    with page.section:
        page.form._typed(GEO, "6 cm")
        page.form.show("terminals", "6 cm")
        page.form._typed(LEO, "66 cm")
        session.set("beacon.divergence", "6 cm")
        page.form.refresh()
    assert "beacon.divergence" in page.form._rows  # one that has come to match gets a row


def test_a_row_takes_over_what_another_tab_sets_but_not_where_it_is_typed_in(session, opened):
    page = opened()
    session.set(LEO, "6 cm")
    page.form.refresh(LEO)
    assert (field(page, LEO), page.form._rows[LEO].typed) == ("5 cm", "5 cm")
    page.form.refresh()
    assert (field(page, LEO), page.form._rows[LEO].typed) == ("6 cm", "6 cm")


@pytest.mark.parametrize(
    ("key", "given", "typed"),
    [
        ("orbit.leo.limits.in_eclipse", False, "false"),
        (LEO, None, ""),
        (LEO, "", ""),
        (LEO, 5, "5"),
        (LEO, "5 cm", "5 cm"),
    ],
)
def test_what_a_field_gives_is_set_as_it_is_typed(session, opened, key, given, typed):
    page, revision = opened(), session.revision
    with page.section:
        page.form.show(mission_form.table_of(key))
        page.form._typed("no.key", "1")
        page.form._typed(key, given)
    assert session.draft.values[key].typed == typed
    assert (session.revision != revision) == (typed != "5 cm")


def test_what_cannot_be_set_stands_in_its_row(session, opened, monkeypatch):
    def refuse(key, typed):
        raise OSError("the disk is full")

    page = opened()
    monkeypatch.setattr(session, "set", refuse)
    page.form._typed(LEO, "6 cm")
    row = page.form._rows[LEO]
    assert (row.said, row.note.text, "error" in row.field.props) == ("the disk is full",) * 2 + (True,)
    assert "wrong" in row.note.classes
    page.form.judge()
    assert "error" not in row.field.props and "wrong" not in row.note.classes
    assert row.note.text.endswith("paper: Table 2")


def test_a_line_is_removed_and_one_that_is_there_no_more_is_refused(session, opened, told):
    page = opened()
    with page.section:
        page.form._drop(LEO)
        assert LEO not in session.draft.values and LEO not in page.form._rows
        assert "\nleo_aperture = " not in page.editor.value
        page.form._drop(LEO)
    assert len(told) == 1 and told[0].startswith(f"{LEO} has no line of its own")


def test_a_key_is_added_with_an_example_or_with_a_text_to_be_given(session, opened, told):
    page, key = opened(), key_of("terminals.leo_obscuration")
    with page.section:
        page.form._add(None)
        assert not session.draft.changed
        page.form._add(key)
        assert session.draft.values[key.key].typed == key.example != ""
        assert key.key in page.form._rows and "leo_obscuration" in page.editor.value
        session.edit(lambda draft: draft.without("name"))
        page.form._add(key_of("name"))
        assert session.draft.values["name"].typed == "to be given"
        page.form._add(key_of("fine_pointing.wheels.speed"))
    assert len(told) == 1 and "fine_pointing.wheels" in told[0]


def test_keys_that_a_table_needs_are_offered_as_such(session, opened):
    page = opened()
    with page.section:
        page.form._drop(LEO)
    (choice,) = (each for each in page.form._place.descendants() if each.props.get("label") == "Another key")
    assert choice.options[LEO] == f"{LEO} (needed)"
    assert choice.options["terminals.leo_obscuration"] == "terminals.leo_obscuration"
    assert all(name.startswith("terminals.") for name in choice.options)
    choice.value = LEO
    assert mission_form._about(key_of(LEO)) in texts(page.form._place)


@pytest.mark.parametrize(
    ("key", "typed", "options"),
    [
        ("conventions.strehl", "ratio", ["decibel", "ratio", "unused"]),
        ("conventions.strehl", "odd", ["decibel", "ratio", "unused", "odd"]),
        ("orbit.leo.limits.in_eclipse", "true", ["true", "false"]),
        ("orbit.leo.limits.in_eclipse", "perhaps", None),
        (LEO, "6 cm", None),
        ("more.unknown", "1", None),
    ],
)
def test_a_choice_has_its_options_and_a_text_has_a_line(session, tab, key, typed, options):
    draft = session.draft.with_text(TEXT + "[more]\nunknown = 1\n").set(key, typed)
    found = mission_form._field(draft.values[key])
    assert "mission-field" in found._classes  # as the style sheet knows it
    assert found.value == typed
    assert getattr(found, "options", None) == options
    other = draft.set(key, "zzz").values[key]
    mission_form._put(found, other)
    assert found.value == "zzz"
    assert getattr(found, "options", None) == (None if options is None else [*options, "zzz"])
    mission_form._put(found, other)
    assert getattr(found, "options", None) == (None if options is None else [*options, "zzz"])


def test_a_key_is_explained_by_what_it_is_and_takes(session):
    choice, quantity = key_of("conventions.strehl"), key_of("control.delay")
    assert mission_form._about(choice) == (choice.description or choice.wanted)
    assert mission_form._about(quantity) == "from sampling to the changed output; a time with its unit, at least 0 s"
    bare = SimpleNamespace(kind="choice", description="", wanted='"a" or "b"')
    assert mission_form._about(bare) == '"a" or "b"'
    assert mission_form._about(SimpleNamespace(kind="text", description="", wanted="text")) == "text"
    values = session.draft.with_text(TEXT + "[more]\nunknown = 1\n").values
    assert mission_form._explained(values["more.unknown"]) == "a key that no mission has"
    assert mission_form._explained(values[LEO]) == f"{mission_form._about(key_of(LEO))}\n{values[LEO].source}"


# ------------------------------------------------------------------------------------------------------- list and text
def chosen(page):
    return [name for name, (button, _) in page.entries.items() if "aria-current" in button.props]


def test_the_table_that_is_shown_is_marked_unless_a_key_is_looked_for(opened):
    page = opened()
    with page.section:
        page._show("beacon")
        assert chosen(page) == ["beacon"]
        page._search(SimpleNamespace(value=" Divergence"))
        assert (chosen(page), page.form.sought, page.form.table) == ([], "divergence", "beacon")
        assert "beacon.divergence" in page.form._rows
        rows = page.form._rows
        page._search(SimpleNamespace(value="DIVERGENCE "))
        assert page.form._rows is rows  # nothing is new
        page._search(SimpleNamespace(value=None))
        assert (chosen(page), page.form.sought) == (["beacon"], "")


def test_the_text_is_scrolled_to_the_key_or_the_line_that_is_gone_to(session, opened, monkeypatch):
    page, lines = opened(), []
    monkeypatch.setattr(page.editor, "reveal_line", lines.append)
    page._reveal("no.key")
    page._reveal(LEO)
    assert lines == [session.draft.values[LEO].line]
    with page.section:
        page._go("beacon.divergence", 0)
        assert page.form.table == "beacon"
        first = next(value.line for key, value in session.draft.values.items() if key.startswith("beacon."))
        assert lines[1:] == [first]
        page._go("beacon.divergence", 7)
        assert lines[2:] == [first, 7]
        page._go("beacon", 0)
        assert page.form.table == "beacon"
        page._go("name", 0)
    assert page.form.table == "general"


def test_a_table_that_the_text_has_no_more_is_not_shown_any_longer(opened):
    page = opened()
    assert page.form.table == "terminals"
    edited(page, 'name = "x"\n[beacon]\ndivergence = "1 urad"\n')
    assert page.form.table == "general"
    with page.section:
        page.form.show("beacon")
    edited(page, 'name = "y"\n[beacon]\ndivergence = "1 urad"\n')
    assert page.form.table == "beacon"


@pytest.mark.parametrize("count", [0, 1, 2, 50, 51])
def test_faults_are_counted_and_no_more_are_told_than_are_left_out(session, opened, count):
    session.change(session.draft.with_text(TEXT + "".join(f"k{n} = 1\n" for n in range(count))))
    found = texts(opened().faults)
    words = {0: "No faults.", 1: "1 fault to correct"}.get(count, f"{count} faults to correct")
    assert found[0] == words
    assert sum(text.startswith("line ") for text in found) == min(count, 50)
    assert [text for text in found if text.startswith("and ")] == (["and 1 more"] if count == 51 else [])


# ---------------------------------------------------------------------------------------------------------------- files
def test_a_mission_goes_back_to_its_file_where_that_is_there_and_differs(session, tab):
    def back():
        with ui.row() as place:
            mission.file_buttons(session, lambda table: None)
        return buttons(place)["Back to the saved file"].enabled

    assert not back()
    session.set(LEO, "6 cm")
    assert back()
    session.reopen()
    session.draft.path.write_text(TEXT.replace('"5 cm"', '"7 cm"'), "utf-8")
    assert back()
    session.draft.path.unlink()
    assert not back()
    session.set(LEO, "6 cm")
    assert not back()


@pytest.fixture
def dialogs(monkeypatch, tab):
    """Dialogs that are opened: title, verb, what is done, what stands in them."""
    found = []

    @contextmanager
    def dialog(title, verb, do):
        with ui.column() as place:
            yield do
        found.append(SimpleNamespace(title=title, verb=verb, do=do, place=place))

    monkeypatch.setattr(mission, "_dialog", dialog)
    return found


def select(dialog):
    return next(each for each in dialog.place.descendants() if isinstance(each, ui.select))


def test_a_new_mission_begins_from_the_shipped_one_or_from_a_preset_under_a_free_name(session, dialogs):
    shown = []
    mission._new(session, shown.append)
    (dialog,) = dialogs
    choice = select(dialog)
    assert (dialog.title, dialog.verb, choice.value) == ("Begin a new mission", "Begin", "shipped mission")
    assert choice.options["shipped mission"] == "the shipped mission, with mirror, loop and orbit"
    assert texts(dialog.place) == []  # nothing is lost
    dialog.do()
    assert (session.draft.path.name, session.draft.text) == ("leo-geo-2.toml", Draft.shipped("").text)
    choice.value = "tbird"
    dialog.do()
    assert (session.draft.path.name, session.draft.text) == ("tbird.toml", preset_text("tbird"))
    assert shown == ["", ""]


def test_what_will_be_lost_is_said_before_another_mission_is_opened(session, dialogs):
    session.set(LEO, "6 cm")
    mission._open(session, lambda table: None)
    mission._new(session, lambda table: None)
    assert [texts(each.place) for each in dialogs] == [["Changes that are not saved will be lost."]] * 2
    assert select(dialogs[0]).options == ["leo-geo.toml"]
    opened = session.opened
    dialogs[0].do()
    assert session.draft.text == TEXT
    assert session.opened == opened + 1  # another mission, and no change of the one before


def test_an_added_table_is_shown(session, dialogs):
    shown = []
    mission._add_table(session, shown.append)
    select(dialogs[0]).value = "[channel]"
    dialogs[0].do()
    assert shown == ["[channel]"]
    assert "[channel]" in session.draft.text


def test_going_back_says_whether_changes_are_lost(session, dialogs):
    shown = []
    mission._revert(session, shown.append)
    session.set(LEO, "6 cm")
    mission._revert(session, shown.append)
    assert [(each.title, each.verb) for each in dialogs] == [
        ("Open leo-geo.toml again as it is on disk now?", "Open again"),
        ("Open leo-geo.toml again and lose the changes?", "Lose the changes"),
    ]
    dialogs[1].do()
    assert (session.draft.text, shown) == (TEXT, [""])


@pytest.mark.parametrize(("typed", "name"), [("b", "b.toml"), ("b.toml", "b.toml"), ("b.txt", "b.txt.toml")])
def test_a_mission_is_saved_under_a_name_with_its_ending(session, dialogs, typed, name):
    shown = []
    mission._save_as(session, shown.append)
    (given,) = (each for each in dialogs[0].place.descendants() if isinstance(each, ui.input))
    assert given.value == "leo-geo.toml"
    for wrong, words in (
        ("../b", "its name holds a path; choose another name"),
        ("", "it has no name"),
        (None, "no na"),
    ):
        given.value = wrong
        with pytest.raises(ValueError, match=words):
            dialogs[0].do()
    assert shown == []
    given.value = typed
    dialogs[0].do()
    assert (session.draft.path, shown) == (session.folder / name, [""])
    assert session.draft.path.read_text("utf-8") == TEXT


def test_a_dialog_says_why_it_cannot_and_closes_once_it_can(tab):
    left = [ValueError("no"), OSError("full"), None]

    def do():
        error = left.pop(0)
        if error is not None:
            raise error

    with mission._dialog("Title", "Do it", do) as go:
        (dialog,) = (each for each in tab.layout.client.elements.values() if isinstance(each, ui.dialog))
    said = []
    for _ in range(3):
        go()
        said.append(([text for text in texts(dialog) if text in ("no", "full")], dialog.value))
    assert said == [(["no"], True), (["full"], True), ([], False)]
    assert {"Title", "Do it", "Cancel"} <= set(texts(dialog))


# ----------------------------------------------------------------------------------------------- the frame of each page
@pytest.mark.parametrize(
    ("changed", "faults", "disk", "words"),
    [
        (False, 0, "", "saved"),
        (True, 0, "", "not saved"),
        (False, 1, "", "saved, 1 fault to correct"),
        (True, 2, "", "not saved, 2 faults to correct"),
        (False, 0, "changed", "changed on disk; open it again"),
        (True, 0, "changed", "not saved, changed on disk; open it again"),
        (False, 0, "gone", "not saved, gone from disk"),
    ],
)
def test_the_frame_says_whether_the_mission_is_saved(changed, faults, disk, words):
    assert layout._words(SimpleNamespace(changed=changed, problems=[0] * faults), disk) == words


def test_a_mission_can_be_saved_where_it_differs_from_its_file(session, tab):
    def save():
        with ui.row() as place:
            layout._state(session)
        return buttons(place)["Save"].enabled

    assert not save()
    session.set(LEO, "6 cm")
    assert save()
    session.save()
    assert not save()
    session.draft.path.unlink()
    assert save()


def test_a_command_of_a_mission_that_is_not_saved_is_copied_with_a_warning(session, monkeypatch):
    said = []
    monkeypatch.setattr(layout.ui, "notify", lambda words, **how: said.append((words, how["type"])))
    assert layout.file_of(session) == Path("leo-geo.toml")
    assert said == []
    session.set(LEO, "6 cm")
    assert layout.file_of(session) == Path("leo-geo.toml")
    assert said == [("The command reads the file: save the mission first, for the same numbers.", "warning")]


@pytest.mark.parametrize("python", [False, True])
@pytest.mark.parametrize("refused", ["", "not allowed"])
def test_what_is_copied_is_said_once_the_browser_has_done_it(monkeypatch, python, refused):
    said, sent, action = [], [], commands.budget(Path("m.toml"))

    async def run(code, timeout):
        sent.append(code)
        return refused

    monkeypatch.setattr(layout.ui, "notify", lambda words, **how: said.append((words, how["type"])))
    monkeypatch.setattr(layout.ui, "run_javascript", run)
    asyncio.run(layout._copy(None, python))
    assert said == sent == []
    asyncio.run(layout._copy(action, python))
    text = action.python if python else action.command
    first = f"Copied: {text.splitlines()[0]}{' ...' if python else ''}"
    assert said == [(f"Not copied, not allowed: {text}", "negative") if refused else (first, "positive")]


def test_a_refusal_is_shown_and_nothing_done_is_told_from_done(monkeypatch, session):
    said = []
    monkeypatch.setattr(layout, "refuse", said.append)
    assert layout.attempt(lambda: None) and layout.save_draft(session)
    assert not layout.attempt(lambda: session.inside("../x"))
    monkeypatch.setattr(session, "save", lambda: Path("/nowhere/x").read_text())
    assert not layout.save_draft(session)
    assert len(said) == 2 and "is outside of" in said[0] and "No such file" in said[1]


def test_a_report_is_shown_in_a_frame_that_says_what_it_is_of(tab, monkeypatch):
    monkeypatch.setattr(ui, "run_javascript", lambda script: None)
    viewer = runs._Viewer()
    viewer.build()
    viewer.show("/files/found/report.html", "found")
    (frame,) = [each for each in viewer.place.descendants() if each.tag == "iframe"]
    assert (frame.props["src"], frame.props["title"]) == ("/files/found/report.html", "found")
    viewer.show("/files/later/report.html", "later")
    assert [each.props["title"] for each in viewer.place.descendants() if each.tag == "iframe"] == ["later"]


def test_faults_that_are_corrected_are_listed_no_more(session, opened):
    page = opened()
    session.change(session.draft.with_text(TEXT + "k1 = 1\nk2 = 1\n"))
    page._faults()
    assert texts(page.faults)[0] == "2 faults to correct"
    session.change(session.draft.with_text(TEXT))
    page._faults()
    assert texts(page.faults) == ["No faults."]


def test_a_table_offers_the_keys_that_it_lacks_and_none_of_one_whose_name_begins_alike(monkeypatch):
    """Keys outside of all tables are offered beside those that stand there."""
    drawn = MagicMock()
    monkeypatch.setattr(mission_form, "ui", drawn)
    absent = [SimpleNamespace(key=key, required=False) for key in ("orbit.epoch", "orbits.kind", "name")]
    absent[0].required = True
    session = SimpleNamespace(draft=SimpleNamespace(absent=absent))
    for table, offered in (
        ("orbit", {"orbit.epoch": "orbit.epoch (needed)"}),
        (mission_form.ROOT, {"name": "name"}),
        ("link", None),
    ):
        drawn.reset_mock()
        mission_form.Form._more(SimpleNamespace(session=session, table=table, _add=None))
        assert [call.args[0] for call in drawn.select.call_args_list] == ([] if offered is None else [offered])


# ------------------------------------------------------------------------------------------ behind the first of a kind
def test_a_key_of_a_table_whose_name_begins_alike_is_counted_to_its_own(session):
    text = "[orbit]\nx = 1\n[orbits]\ny = 1\nz = 2\n[orbit.leo]\nw = 3\n"
    draft = session.draft.with_text(text)
    found = mission_form.tables(draft)
    assert [*found][:2] == ["orbit", "orbits"]
    assert [mission_form.table_of(key) for key in ("orbit.leo.w", "orbits.y", "orbit", "name")] == [
        "orbit",
        "orbits",
        "general",
        "general",
    ]
    assert found["orbits"] == sum(f.key.split(".")[0] == "orbits" for f in draft.problems) > 0


def test_rows_stand_under_the_heading_of_their_inner_table(session, opened):
    page = opened()
    with page.section:
        page.form.show("orbit")
    shown = [each.text for each in page.form._place.descendants() if each.tag == "h2"]
    inner = [*dict.fromkeys(key.rpartition(".")[0] for key in page.form._rows)]
    assert shown == [f"[{name}]" for name in inner] and len(shown) >= 3
    assert [*page.form._rows] == [key for key in session.draft.values if key.startswith("orbit.")]
    with page.section:
        page.form.show(mission_form.ROOT)
    assert [each.text for each in page.form._place.descendants() if each.tag == "h2"] == ["General"]


def test_each_row_is_joined_to_its_own_label_and_note(opened):
    page = opened()
    rows = page.form._rows
    places = range(len(rows))
    assert [row.field.props["for"] for row in rows.values()] == [f"key-{n}" for n in places]
    assert [row.note.props["id"] for row in rows.values()] == [f"note-{n}" for n in places]
    labels = [each for each in page.form._place.descendants() if "mission-key" in each.classes]
    assert [each.props["for"] for each in labels] == [f"key-{n}" for n in places]
    assert [texts(each)[0] for each in labels] == [key.rpartition(".")[2] for key in rows]
    assert [row.field.value for row in rows.values()] == [row.typed for row in rows.values()]


def test_two_faults_of_a_row_are_told_behind_each_other_and_only_there(session, opened):
    page = opened()
    one, two = Fault(GEO, "x", 3, "reason one", "wanted one"), Fault(GEO, "y", 3, "reason two", "wanted two", "a.b")
    values = session.draft.values
    mission_form._judge(page.form._rows[GEO], replace(values[GEO], problems=(one, two)))
    said = page.form._rows[GEO]
    assert said.note.text == ("reason one; expected: wanted one reason two; did you mean a.b? expected: wanted two")
    assert "wrong" in said.note.classes and "error" in said.field.props
    assert "wrong" not in page.form._rows[LEO].note.classes
    mission_form._judge(said, values[GEO])
    assert "wrong" not in said.note.classes and "error" not in said.field.props
    assert said.note.text == said.said == mission_form._explained(values[GEO])


@pytest.mark.parametrize(
    ("key", "line", "table", "revealed"),
    [
        (GEO, 17, "terminals", 17),
        ("orbit", 0, "orbit", None),
        ("orbit.leo.none", 5, "orbit", 5),
        ("odd", 9, "general", 9),
    ],
)
def test_a_fault_leads_to_its_table_and_its_line(session, opened, monkeypatch, key, line, table, revealed):
    page = opened()
    lines = []
    monkeypatch.setattr(page.editor, "reveal_line", lines.append)
    with page.section:
        page._go(key, line)
    assert page.form.table == table
    assert lines[-1] == (
        revealed or session.draft.values[next(k for k in session.draft.values if k[:6] == "orbit.")].line
    )
    marked = [name for name, (button, _) in page.entries.items() if "aria-current" in button.props]
    assert marked == [table]


def test_a_fault_is_listed_by_its_line_and_key_with_its_words(session, opened):
    page = opened()
    session.set(LEO, "5 parsec")
    session.change(session.draft.with_text(session.draft.text.replace("[requirement]", "[requirements]")))
    page._faults()
    problems = session.draft.problems
    places = [f"line {fault.line}: {fault.key}" if fault.line else fault.key for fault in problems]
    assert [*buttons(page.faults)] == places and len(places) > 1
    listed = texts(page.faults)
    assert listed[0] == f"{len(problems)} faults to correct"
    assert [text for text in listed if "; " in text] == [mission_form.fault_words(fault) for fault in problems]


def test_pages_are_reached_by_links_of_which_the_present_one_is_marked(session):
    entries = (("Mission", "/"), ("Runs", "/runs"), ("Run", "/run"))
    client = Client(at("/"), request=None)
    with client:
        with layout.frame(session, "Run", entries):
            layout.words("p", "the body")
        links = [each for each in client.elements.values() if isinstance(each, ui.link)]
        heads = [each.text for each in client.elements.values() if each.tag == "h1"]
    assert [(each.text, each.props["href"]) for each in links] == [*entries]
    assert [each.text for each in links if "aria-current" in each.props] == ["Run"]
    assert heads == ["Run"]
    client.delete()


def test_a_page_is_brought_up_to_date_once_for_each_revision(monkeypatch):
    looks, shows = [], []
    monkeypatch.setattr(layout.ui, "timer", lambda every_s, look: looks.append((every_s, look)))
    session = SimpleNamespace(disk="", revision=4)
    mark = layout.follow(session, lambda: shows.append(session.revision))
    ((every_s, look),) = looks
    assert (every_s, shows) == (0.5, [4])
    look()
    session.revision = 5
    look()
    look()
    session.revision = 7
    mark()
    look()
    session.revision = 8
    look()
    assert shows == [4, 5, 8]


def test_bad_news_is_red_and_good_news_green(session, monkeypatch):
    """Orange-red and bluish green, which also the colour-blind tell apart."""
    given = []
    monkeypatch.setattr(layout.ui, "colors", lambda **colours: given.append(colours))
    client = Client(at("/"), request=None)
    with client, layout.frame(session, "Mission", (("Mission", "/"),)):
        pass
    client.delete()
    (colours,) = given
    parts = {name: [int(colour[k : k + 2], 16) for k in (1, 3, 5)] for name, colour in colours.items()}
    assert {name: part.index(max(part)) for name, part in parts.items()} == {"primary": 2, "negative": 0, "positive": 1}


# ---------------------------------------------------------------------------------------------- what stands in its rows
MADE_UP = """
[conventions]
pointing_loss = "gaussian"            # assumption: of the two readings
strehl = "db"

[answer]
pointing_error = "300 urad"
colour = "red"                        # paper: nobody knows

[fine_pointing]
seed = 7

[requirement]
margin = "3 dB"

[jitter]
bias = ["1 urad", "-2.5 urad"]        # paper: Table 4
"""


def rows_of(table):
    def build(session, page):
        page.form.show(table)
        return page.form._place

    return build


def keys_with(sought):
    def build(session, page):
        page.form.show("answer", sought)
        return page.form._place

    return build


def listed_tables(session, page):
    page.list.clear()
    page.entries = {}
    page._list()
    page._show("answer")
    return page.list


def dialog_of(name):
    def build(session, page):
        session.edit(lambda draft: draft.with_text(draft.text.replace("seed = 7", "seed = 8")))
        with ui.column() as place:
            getattr(mission, name)(session, print)
        return next(each for each in place.client.elements.values() if isinstance(each, ui.dialog))

    return build


PARTS = {
    **{f"rows of {table}": rows_of(table) for table in ("conventions", "answer", "jitter", "none")},
    **{f"keys with {sought}": keys_with(sought) for sought in ("paper: TA", "nothing")},
    "tables": listed_tables,
    **{name: dialog_of(name) for name in ("_open", "_save_as", "_revert", "_add_table")},
}
STANDS = {
    "rows of conventions": """
h2 [conventions]
div.mission-row
  label.mission-key[for=key-0]
    span.mission-name pointing_loss
  select.mission-field[dense|outlined|options-dense|for=key-0] = gaussian of gaussian, gain, pattern
  div.mission-note[id=note-0] gaussian: beam with 1/e2 radius D/2 at the aperture; gain: exp(-G theta^2); pattern: \
the far field of communication.beam / assumption: of the two readings
  div.mission-drop
div.mission-row
  label.mission-key[for=key-1]
    span.mission-name strehl
  select.mission-field[dense|outlined|options-dense|for=key-1|error] = db of decibel, ratio, unused, db
  div.mission-note.wrong[id=note-1] is none of the choices; expected: strehl = "decibel" or strehl = "ratio" or \
strehl = "unused"
  div.mission-drop
    q-btn[aria-label=Remove conventions.strehl|dense|flat|round|icon=close]
    q-tooltip Remove this line
div.mission-more
  select.mission-choice[label=Another key|dense|outlined] of conventions.divergence, conventions.residual \
(needed), conventions.mirror_angle (needed)
  q-btn[outline|no-caps] Add
  div.soft.small.mission-about
""",
    "rows of answer": """
h2 [answer]
div.mission-row
  label.mission-key[for=key-0]
    span.mission-name pointing_error
    span such as 5 urad
  input.mission-field[dense|outlined|debounce=150|spellcheck=false|for=key-0] = 300 urad
  div.mission-note[id=note-0] off the line of sight, radial; an angle with its unit, at least 0 rad, at most 1.571 rad
  div.mission-drop
div.mission-row
  label.mission-key[for=key-1]
    span.mission-name colour
  input.mission-field[dense|outlined|debounce=150|spellcheck=false|for=key-1|error] = red
  div.mission-note.wrong[id=note-1] is no key of [answer]; expected: one of transmit_power, wavelength, strehl, \
wavefront_error, pointing_error, distance, transmit_optics_loss, receive_optics_loss, divergence, required_power
  div.mission-drop
    q-btn[aria-label=Remove answer.colour|dense|flat|round|icon=close]
    q-tooltip Remove this line
div.mission-more
  select.mission-choice[label=Another key|dense|outlined] of answer.transmit_power (needed), answer.wavelength \
(needed), answer.strehl, answer.wavefront_error, answer.distance, answer.transmit_optics_loss (needed), \
answer.receive_optics_loss (needed), answer.divergence (needed), answer.required_power (needed)
  q-btn[outline|no-caps] Add
  div.soft.small.mission-about
""",
    "rows of jitter": """
h2 [jitter]
div.mission-row.wide
  label.mission-key[for=key-0]
    span.mission-name bias
    span such as 5 urad
  input.mission-field[dense|outlined|debounce=150|spellcheck=false|for=key-0] = 1 urad, -2.5 urad
  div.mission-note[id=note-0] static, about x and y; a list, each item an angle with its unit, at least -1.571 \
rad, at most 1.571 rad / paper: Table 4
  div.mission-drop
div.mission-more
  select.mission-choice[label=Another key|dense|outlined] of jitter.rms (needed), jitter.bandwidth (needed)
  q-btn[outline|no-caps] Add
  div.soft.small.mission-about
""",
    "rows of none": """
div This table has no keys of its own.
""",
    "keys with paper: TA": """
h2 [jitter]
div.mission-row.wide
  label.mission-key[for=key-0]
    span.mission-name bias
    span such as 5 urad
  input.mission-field[dense|outlined|debounce=150|spellcheck=false|for=key-0] = 1 urad, -2.5 urad
  div.mission-note[id=note-0] static, about x and y; a list, each item an angle with its unit, at least -1.571 \
rad, at most 1.571 rad / paper: Table 4
  div.mission-drop
""",
    "keys with nothing": """
div No key has this text.
""",
    "tables": """
q-btn.mission-entry[flat|no-caps|align=left]
  span conventions
  span.mission-badge 3
q-btn.mission-entry[aria-current=true|flat|no-caps|align=left]
  span answer
  span.mission-badge 8
q-btn.mission-entry[flat|no-caps|align=left]
  span fine_pointing
  span.mission-badge 16
q-btn.mission-entry[flat|no-caps|align=left]
  span requirement
  span.mission-badge 3
q-btn.mission-entry[flat|no-caps|align=left]
  span jitter
  span.mission-badge 2
q-btn.mission-entry[flat|no-caps|align=left]
  span general
  span.mission-badge 9
""",
    "_open": """
q-card.mission-dialog
  h2 Open a mission in FOLDER
  select[label=File|outlined] = leo-geo.toml of leo-geo.toml
  div Changes that are not saved will be lost.
  div.no.kept[role=alert]
  div
    q-btn[no-caps] Open
    q-btn[outline|no-caps] Cancel
""",
    "_save_as": """
q-card.mission-dialog
  h2 Save the mission in FOLDER
  input[label=Name of the file|outlined] = leo-geo.toml
  div.no.kept[role=alert]
  div
    q-btn[no-caps] Save
    q-btn[outline|no-caps] Cancel
""",
    "_revert": """
q-card.mission-dialog
  h2 Open leo-geo.toml again and lose the changes?
  div.no.kept[role=alert]
  div
    q-btn[no-caps] Lose the changes
    q-btn[outline|no-caps] Cancel
""",
    "_add_table": """
q-card.mission-dialog
  h2 Add a table, with example values to be changed
  select[label=Table|outlined] = [pointing] of [pointing], [point_ahead], [terminals], [beacon], [communication], \
[acquisition], [orbit], [operations], [constellation], [mirror], [amplifier], [control], [scenario], [channel], \
[fine_pointing.geometry], [fine_pointing.vibration], [fine_pointing.body], [fine_pointing.optical_sensor], \
[fine_pointing.strain_gauge], [fine_pointing.reference], [fine_pointing.wheels], [fine_pointing.misalignment], \
[fine_pointing.optical_sensor.quad_cell]
  div.no.kept[role=alert]
  div
    q-btn[no-caps] Add
    q-btn[outline|no-caps] Cancel
""",
}


@pytest.mark.parametrize("name", PARTS)
def test_a_part_of_the_mission_is_built_of_all_that_belongs_to_it(session, opened, name):
    session.draft.path.write_text(MADE_UP, "utf-8")
    session.reopen()
    page = opened()
    with page.list.client:
        part = PARTS[name](session, page)
    found = [line.rstrip().replace(str(session.folder), "FOLDER") for line in outline(part)]
    assert found == STANDS[name].strip().splitlines()


def test_each_button_about_files_opens_its_own_dialog(session, tab, monkeypatch):
    asked = []
    for name in ("_open", "_new", "_save_as", "_revert", "_add_table"):
        monkeypatch.setattr(mission, name, lambda of, shown, name=name: asked.append((name, of, shown)))
    with ui.row() as place:
        mission.file_buttons(session, print)
    for each in buttons(place).values():
        press(each)
    assert asked == [(name, session, print) for name in ("_open", "_new", "_save_as", "_revert", "_add_table")]


def test_a_table_a_key_and_a_fault_are_gone_to_by_their_buttons(session, opened, monkeypatch):
    page, called = opened(), []
    for name in ("_show", "_go"):
        monkeypatch.setattr(page, name, lambda *args, name=name: called.append((name, *args)))
    page.list.clear()
    page.entries = {}
    session.edit(lambda draft: draft.set(LEO, "5 parsec").set(GEO, "6 furlong"))
    page._list()
    page._faults()
    first, second = page.session.draft.problems
    for each in (page.entries["orbit"][0], page.entries["terminals"][0], *buttons(page.faults).values()):
        press(each)
    assert called == [
        *(("_show", "orbit"), ("_show", "terminals")),
        *(("_go", LEO, first.line), ("_go", GEO, second.line)),
    ]


def test_a_line_is_removed_and_a_key_added_by_their_buttons(session, opened):
    page, held = opened(), [*session.draft.values]
    page.form.show("terminals")
    place = page.form._place
    choice = next(each for each in place.descendants() if "mission-choice" in each.classes)
    choice.value = "terminals.geo_obscuration"
    press(buttons(place)["Add"])
    assert [key for key in session.draft.values if key not in held] == ["terminals.geo_obscuration"]
    press(
        next(each for each in place.descendants() if each.props.get("aria-label") == "Remove terminals.geo_obscuration")
    )
    assert [*session.draft.values] == held


# ----------------------------------------------------------------------------------------------- with their settings
@pytest.fixture
def notes(monkeypatch):
    """Notices of the pages, with their settings."""
    found = []
    monkeypatch.setattr(layout.ui, "notify", lambda words, **settings: found.append((words, settings)))
    return found


def test_a_refusal_stays_on_top_until_it_is_dismissed(notes):
    layout.refuse("the reason\nin two lines")
    settings = {"type": "negative", "multi_line": True, "timeout": 0, "close_button": "Dismiss", "position": "top"}
    assert notes == [("the reason\nin two lines", settings)]


@pytest.mark.parametrize("changed", [False, True])
def test_a_command_that_reads_another_text_than_is_shown_is_copied_with_a_notice(session, notes, changed):
    if changed:
        session.set(LEO, "6 cm")
    assert layout.file_of(session) == Path("leo-geo.toml")
    words = "The command reads the file: save the mission first, for the same numbers."
    assert notes == [(words, {"type": "warning"})] * changed


@pytest.mark.parametrize(
    ("refused", "python", "note"),
    [
        ("", False, ("Copied: microrad run 'a b'", {"type": "positive"})),
        ("", True, ("Copied: one ...", {"type": "positive"})),
        ("no", False, ("Not copied, no: microrad run 'a b'", {"type": "negative", "multi_line": True})),
        ("no", True, ("Not copied, no: one\ntwo\n", {"type": "negative", "multi_line": True})),
    ],
)
def test_a_copy_is_told_of_with_its_settings(monkeypatch, notes, refused, python, note):
    asked = []

    async def run(script, timeout):
        asked.append((script, timeout))
        return refused

    monkeypatch.setattr(layout.ui, "run_javascript", run)
    action = layout.Action(("run", "a b"), "one\ntwo\n")
    with ThreadPoolExecutor(1) as thread:
        thread.submit(asyncio.run, layout._copy(action, python)).result()
        assert thread.submit(asyncio.run, layout._copy(None, python)).result() is None
    ((script, timeout),) = asked
    assert ('writeText("one\\ntwo\\n")' if python else "writeText(\"microrad run 'a b'\")") in script
    assert (timeout, notes) == (60.0, [note])
    assert "the browser lets pages copy over https or from this machine only" in script


def test_the_text_of_a_mission_is_edited_as_toml(session, opened):
    page = opened()
    editor = page.editor
    assert (editor.props["language"], editor.props["theme"], editor.value) == ("TOML", "vscodeLight", TEXT)
    assert page.section.default_slot.children.index(editor) < page.section.default_slot.children.index(page.faults)
    heard = {each.type: each for each in page.section._event_listeners.values()}
    assert [*heard] == ["paste.capture", "drop.capture"]
    assert all("size <= 500000" in each.js_handler for each in heard.values())


def test_a_text_that_is_too_long_is_refused_with_its_limit(session, opened, told):
    opened()._too_much()
    assert told == ["that text has more than 500000 characters and is no mission: it was not put in"]


def test_what_is_behind_is_told_as_a_warning_and_not_taken(session, opened, notes):
    page = opened()
    page.shown = "another text"
    page._text(SimpleNamespace(value="typed"))
    words = "The mission was changed in another tab just now: the text shows it; type that again."
    assert notes == [(words, {"type": "warning"})]
    assert (session.draft.text, page.shown, page.editor.value) == (TEXT, TEXT, TEXT)


def heard(element):
    """What an element listens to, with what is done then."""
    return {each.type: each.handler for each in element._event_listeners.values()}


def test_a_name_that_is_typed_is_saved_by_the_key_enter_too(session, dialogs):
    mission._save_as(session, lambda table: None)
    name = next(each for each in dialogs[0].place.descendants() if isinstance(each, ui.input))
    name.value = "other"
    assert heard(name)["keydown.enter"] == dialogs[0].do
    dialogs[0].do()
    assert session.draft.path.name == "other.toml"


def test_a_field_that_is_entered_or_changed_tells_its_own_key(session, opened, monkeypatch):
    page, entered = opened(), []
    monkeypatch.setattr(page.form, "_entered", entered.append)
    for key in (GEO, LEO):
        heard(page.form._rows[key].field)["focus"]()
    assert entered == [GEO, LEO]
    page.form._rows[GEO].field.value = "17 cm"
    assert [session.draft.values[key].typed for key in (LEO, GEO)] == ["5 cm", "17 cm"]


def test_a_key_is_looked_for_as_it_is_typed_in_the_field_above_the_tables(session, opened):
    page = opened()
    page.search.value = "  Data_RATE "
    assert (page.form.sought, [*page.form._rows]) == (
        "data_rate",
        [key for key, value in session.draft.values.items() if "data_rate" in f"{key} {value.comment}".lower()],
    )
    page.search.value = None
    assert (page.form.sought, page.form.table) == ("", "terminals")


def test_a_dialog_closes_when_its_work_is_done_and_says_why_it_could_not_be(tab):
    faults = [ValueError("no such table"), None]

    def work():
        if fault := faults.pop(0):
            raise fault

    with ui.row() as place, mission._dialog("Add a table", "Add", work):
        ui.label("within")
    (shown,) = (each for each in place.client.elements.values() if isinstance(each, ui.dialog) and each.value)
    add = buttons(shown)["Add"]
    press(add)
    assert (shown.value, "no such table" in texts(shown)) == (True, True)
    press(add)
    assert (shown.value, "no such table" in texts(shown)) == (False, False)


def test_the_form_leaves_a_table_that_another_mission_does_not_have(opened, session):
    page = opened()
    page.form.show("relay")
    session.change(session.draft.with_text('name = "two"\n[terminals]\nleo_aperture = "5 cm"\n'))
    page._all()
    assert page.form.table == next(iter(mission.tables(session.draft)))


# -------------------------------------------------------------------------------------------- what is rarely the case
def test_a_text_with_a_mark_and_line_ends_of_windows_is_edited_without_and_keeps_them(session, opened, notes):
    session.draft.path.write_bytes(b"\xef\xbb\xbf" + TEXT.replace("\n", "\r\n").encode())
    session.reopen()
    page = opened()
    assert page.editor.value == page.shown == TEXT
    typed = TEXT.replace('leo_aperture = "5 cm"', 'leo_aperture = "6 cm"')
    page._text(SimpleNamespace(value=typed))
    assert (notes, page.shown, session.draft.values[LEO].typed) == ([], typed, "6 cm")
    assert session.draft.text == "\ufeff" + typed.replace("\n", "\r\n")
    session.save()
    assert session.draft.path.read_bytes() == b"\xef\xbb\xbf" + typed.replace("\n", "\r\n").encode()


@pytest.mark.parametrize(("added", "table"), [("[beacon]", "beacon"), ("[orbit.leo.limits]", "orbit")])
def test_an_inner_table_that_was_added_is_shown_with_its_outermost_one(opened, added, table):
    page = opened()
    with page.section:
        page._other(added)
    assert (page.form.table, chosen(page)) == (table, [table])
    assert all(mission_form.table_of(key) == table for key in page.form._rows) and page.form._rows


@pytest.mark.parametrize(
    ("draft", "lost"),
    [
        (lambda session: session.draft, ""),
        (lambda session: session.draft.set(LEO, "6 cm"), "Changes that are not saved will be lost."),
        (lambda session: Draft.shipped(session.inside("n.toml")), ""),
        (lambda session: Draft.shipped(session.inside("n.toml")).with_text(preset_text("tbird")), ""),
        (
            lambda session: Draft.shipped(session.inside("n.toml")).set(LEO, "6 cm"),
            "n.toml is not on disk and will be lost; save it first to keep it.",
        ),
    ],
)
def test_what_a_mission_can_begin_from_again_is_not_lost(session, draft, lost):
    session.replace(draft(session))
    assert mission._lost(session) == lost
    if session.draft.path.exists():
        session.draft.path.unlink()
        assert mission._lost(session) == "leo-geo.toml is not on disk and will be lost; save it first to keep it."


def test_a_text_that_the_disk_does_not_take_is_refused(session, opened, told, monkeypatch):
    def full(draft, name):
        raise OSError("the disk is full")

    page = opened()
    monkeypatch.setattr(session, "_keep", full)
    page._text(SimpleNamespace(value=f"{TEXT}# more\n"))
    assert (told, session.draft.text) == (["the disk is full"], TEXT)


def test_what_is_typed_into_a_mission_that_was_opened_anew_is_not_taken_although_its_text_is_the_same(
    session, opened, notes
):
    page = opened()
    editor = page.editor
    session.replace(session.draft)
    page._text(SimpleNamespace(value=f"{TEXT}# more\n"))
    assert (session.draft.text, len(notes), notes[0][1]) == (TEXT, 1, {"type": "warning"})
    assert page.editor is not editor and page.editor.value == TEXT
    page._text(SimpleNamespace(value=f"{TEXT}# more\n"))
    assert (session.draft.text, len(notes)) == (f"{TEXT}# more\n", 1)


def test_a_mission_that_is_a_link_to_another_folder_is_not_opened(session, dialogs, tmp_path_factory):
    outside = tmp_path_factory.mktemp("outside") / "b.toml"
    outside.write_text(TEXT, "utf-8")
    (session.folder / "b.toml").symlink_to(outside)
    mission._open(session, lambda table: None)
    assert select(dialogs[0]).options == ["b.toml", "leo-geo.toml"]
    assert select(dialogs[0]).value == "b.toml"
    with pytest.raises(NameRefusedError, match=r"is outside of"):
        dialogs[0].do()
    assert (session.draft.path.name, session.opened) == ("leo-geo.toml", 0)


def test_a_new_mission_has_the_name_of_what_it_begins_from_whatever_was_open(session, dialogs):
    session.save("other.toml")
    (session.folder / "tbird.toml").touch()
    mission._new(session, lambda table: None)
    dialogs[0].do()
    assert session.draft.path.name == "leo-geo-2.toml"
    select(dialogs[0]).value = "tbird"
    dialogs[0].do()
    assert session.draft.path.name == "tbird-2.toml"


@pytest.mark.parametrize(("typed", "name"), [("B.TOML", "B.TOML.toml"), ("a.toml.old", "a.toml.old.toml")])
def test_a_name_that_ends_otherwise_gets_the_ending_by_which_missions_are_found(session, dialogs, typed, name):
    mission._save_as(session, lambda table: None)
    next(each for each in dialogs[0].place.descendants() if isinstance(each, ui.input)).value = typed
    dialogs[0].do()
    assert [path.name for path in session.missions()] == sorted([name, "leo-geo.toml"])


def test_a_table_that_is_gone_to_ends_the_search(opened):
    page = opened()
    page.search.value = "divergence"
    assert page.form.sought == "divergence"
    with page.section:
        page._show("answer")
    assert (page.search.value, page.form.sought, page.form.table, chosen(page)) == ("", "", "answer", ["answer"])


@pytest.mark.parametrize(
    ("sought", "found"),
    [("leo_aperture = 5 CM", [LEO]), ("terminals.GEO_ap", [GEO]), ("aperture = 5 cm paper", [LEO]), ("= 5 parsec", [])],
)
def test_a_key_is_looked_for_with_its_value_as_its_line_has_them(opened, sought, found):
    page = opened()
    with page.section:
        page.form.show("beacon", sought)
    assert [*page.form._rows] == found


@pytest.mark.parametrize("count", [49, 51])
def test_of_many_tables_the_first_fifty_are_listed(session, opened, count):
    names = [f"t{k}" for k in range(count)]
    session.change(session.draft.with_text('name = "x"\n' + "".join(f"[{name}]\nx = 1\n" for name in names)))
    assert [*opened().entries] == ["general", *names][:50]


def test_the_table_that_is_shown_stays_marked_where_the_list_is_made_anew(session, opened):
    page = opened()
    with page.section:
        page._show("beacon")
        tables = list(page.entries)
        session.change(session.draft.with_text(session.draft.text + "[more]\nunknown = 1\n"))
        page._list()
        assert list(page.entries) != tables and chosen(page) == ["beacon"]
