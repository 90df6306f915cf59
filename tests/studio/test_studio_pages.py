"""The pages beside that of the mission as the server builds them, without a browser."""

import asyncio
import io
import json
import os
import re
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import pytest

from microrad.mission.presets import preset_text
from microrad.report.tables import Cell, Table
from microrad.report.view import Drawing, Points, Soft, Verbatim, Verdict, View
from microrad.studio import commands
from microrad.studio.draft.draft import Draft
from microrad.studio.jobs.files import Job, Progress
from microrad.studio.jobs.queue import JobError
from microrad.studio.recordings.reading import ChannelInfo, Listing
from microrad.studio.recordings.reading import View as Read
from microrad.studio.recordings.uploads import UploadLimits
from microrad.studio.views import day as day_view
from microrad.studio.views import link as link_view
from microrad.studio.views import mirror_form
from microrad.studio.views.campaign import Figures
from microrad.studio.views.latest import State
from microrad.studio.views.mirror_form import Form, Setting
from microrad.studio.views.plots import empty
from microrad.studio.views.runs import Others
from microrad.studio.views.sliders import Attempt
from shipped import SHIPPED, links_alone

pytest.importorskip("nicegui", reason="the studio is not installed (nicegui)")

from nicegui import ui
from nicegui.client import Client
from nicegui.page import page as at
from starlette.datastructures import FormData, UploadFile

from microrad.studio.pages import (
    compare,
    control,
    day,
    drop,
    elements,
    in_thread,
    layout,
    link,
    mirror,
    mirror_job,
    mission,
    pointing,
    runs,
    runs_jobs,
    sliders,
)
from studio_pages import buttons, here, outline, press, texts

LEO = "terminals.leo_aperture"
TEXT = SHIPPED.read_text("utf-8")


@pytest.fixture
def tab(monkeypatch):
    """A page that elements are put on, whose handlers wait for no thread."""
    for module in (compare, control, day, link, mirror, mirror_job, pointing, runs, runs_jobs, sliders):
        if hasattr(module, "in_thread"):
            monkeypatch.setattr(module, "in_thread", here)
        if hasattr(module, "background_tasks"):
            monkeypatch.setattr(module, "background_tasks", SimpleNamespace(create=_left, create_lazy=_left))
    client = Client(at("/"), request=None)
    with client:
        yield client
    client.delete()


def _left(task, **_):
    """A task that is not begun."""
    task.close()


@pytest.fixture
def told(monkeypatch):
    """What pages refuse, in words."""
    words = []
    monkeypatch.setattr(layout, "refuse", words.append)
    return words


# -------------------------------------------------------------------------------------------------------------- compare
@pytest.fixture
def compared(session, tab, monkeypatch):
    """The page of the comparison; what its tables show."""
    monkeypatch.setattr(compare.compare_view, "blocks", lambda session, *two: two)
    page = compare._Page(session)
    page.seen = []
    monkeypatch.setattr(page.told, "show_blocks", page.seen.append)
    return page


def test_a_mission_is_compared_with_its_file_others_and_presets(session, compared):
    (session.folder / "b.toml").write_text(TEXT, "utf-8")
    (session.folder / "c.toml").write_text('mission = "leo-geo.toml"', "utf-8")
    found = compared._options()
    assert list(found)[:2] == ["file b.toml", compare._SHIPPED]
    assert (found["file b.toml"], found[compare._PRESET + "tbird"].partition(":")[0]) == ("b.toml", "tbird")
    assert not {"file leo-geo.toml", "file c.toml", compare._SAVED} & set(found)
    session.set(LEO, "6 cm")
    assert compared._options()[compare._SAVED] == "leo-geo.toml as it is saved"
    session.draft.path.unlink()
    assert compare._SAVED not in compared._options()


def test_the_other_mission_is_the_one_that_was_chosen(session, compared):
    (session.folder / "b.toml").write_text(TEXT.replace('"5 cm"', '"7 cm"'), "utf-8")
    session.set(LEO, "6 cm")
    assert compared._draft(compare._SAVED).values[LEO].typed == "5 cm"
    assert compared._draft("file b.toml").values[LEO].typed == "7 cm"
    assert compared._draft(compare._SHIPPED).text == Draft.shipped("").text
    assert compared._draft(compare._PRESET + "tbird").text == preset_text("tbird")


def test_a_choice_is_taken_once_and_one_that_cannot_be_read_says_why(session, compared):
    (session.folder / "b.toml").write_text(TEXT, "utf-8")
    for value in (None, ""):
        compared._chosen(SimpleNamespace(value=value))
        assert (session.other, compared.shown) == (None, None)
    compared._chosen(SimpleNamespace(value="file b.toml"))
    first = session.other
    assert (first.path.name, compared.shown, compared.fault.text) == ("b.toml", "file b.toml", "")
    compared._chosen(SimpleNamespace(value="file b.toml"))
    assert session.other is first
    compared._chosen(SimpleNamespace(value="file none.toml"))
    assert "does not exist" in compared.fault.text
    assert session.other is first
    compared._chosen(SimpleNamespace(value=compare._SHIPPED))
    assert compared.fault.text == ""


def test_the_choice_is_that_of_the_other_mission_where_it_can_be_chosen(session, compared):
    (session.folder / "b.toml").write_text(TEXT, "utf-8")
    assert compared._compared(compared._options()) is None
    session.other = Draft.open(session.folder / "b.toml")
    compared._look()
    assert (compared.choice.value, compared.shown) == ("file b.toml", "file b.toml")
    assert compared._name(session.other) == "b.toml"
    (session.folder / "b.toml").unlink()
    compared._look()
    assert compared.choice.value is None
    session.other = Draft.open(session.draft.path)
    session.set(LEO, "6 cm")
    compared._look()
    assert (compared.choice.value, compared._name(session.other)) == (compare._SAVED, "leo-geo.toml (saved)")


def test_a_choice_that_cannot_be_read_stays_chosen_beside_its_reason(session, compared):
    (session.folder / "b.toml").write_bytes(b"\xff")
    session.other = Draft.shipped(session.inside(compare._SHIPPED))
    compared._look()
    assert compared.choice.value == compare._SHIPPED
    compared.choice.set_options(compared._options(), value="file b.toml")
    assert compared.fault.text != ""
    (session.folder / "d.toml").write_text(TEXT, "utf-8")  # there are other options now
    compared._look()
    assert (compared.choice.value, "file d.toml" in compared.choice.options) == ("file b.toml", True)


def test_the_tables_are_those_of_what_was_asked_last(session, compared):
    asyncio.run(compared._show(compared.asked))
    assert compared.seen.pop() == [Soft("Choose the mission that this one is to be compared with.")]
    session.other = session.draft
    asyncio.run(compared._show(compared.asked - 1))
    assert compared.seen == []
    asyncio.run(compared._show(compared.asked))
    assert compared.seen == [(session.draft, session.draft, ("leo-geo.toml", "leo-geo.toml (saved)"))]


def test_the_budget_of_each_mission_is_copied_from_its_file(session, compared, told, monkeypatch):
    said = []
    monkeypatch.setattr(layout, "file_of", lambda session: said.append(1) or Path("mine.toml"))
    assert compared._action(other=False) == commands.budget(Path("mine.toml"))
    session.other = session.draft
    assert compared._action(other=True) == commands.budget(Path("leo-geo.toml"))
    assert (said, told) == ([1], [])
    session.draft.path.unlink()
    assert compared._action(other=False) is None
    assert told == ["leo-geo.toml is not a file of this folder yet; save it there first."]


# ----------------------------------------------------------------------------------------------------------------- runs
@pytest.fixture
def asked(session, monkeypatch):
    """Orders that are queued; `asked.refusal` is raised in place of it."""
    found = []

    def submit(order):
        if refusals:
            raise refusals.pop()
        found.append(order)

    refusals = []
    monkeypatch.setattr(session.jobs, "submit", submit)
    return SimpleNamespace(orders=found, refusals=refusals)


def test_a_study_is_run_into_a_free_folder_once_the_mission_is_saved(session, tab, asked, told):
    study = runs._Study(session)
    assert (study.button.text, study.button.enabled, study.fault.text) == ("Run the study", True, "")
    assert study.about.text == "Everything that follows from leo-geo.toml: verdict, figures, report."
    asyncio.run(study._name())
    assert study.folder.value == "leo-geo-study"
    for wrong, words in (
        ("../x", "its name holds a path; choose another name"),
        ("", "it has no name"),
        (None, "no na"),
    ):
        study.folder.value = wrong
        asyncio.run(study._run())
        assert words in study.fault.text
    assert asked.orders == []
    study.folder.value = "leo-geo-study"
    assert study._action() is not None and study.fault.text == ""
    (session.folder / "leo-geo-study").mkdir()
    session.set(LEO, "6 cm")
    study._look()
    assert study.button.text == "Save and run the study"
    asyncio.run(study._run())
    (order,) = asked.orders
    assert order.arguments == commands.study(Path("leo-geo.toml"), Path("leo-geo-study")).arguments
    assert order.kind == "study"
    assert not session.draft.changed
    assert (study.folder.value, study.fault.text) == ("leo-geo-study-2", "")
    asked.refusals.append(JobError("no room"))
    asyncio.run(study._run())
    assert (told, study.folder.value) == (["no room"], "leo-geo-study-2")


def test_a_study_of_a_mission_with_faults_or_that_cannot_be_saved_is_not_run(session, tab, asked, told, monkeypatch):
    study = runs._Study(session)
    study.folder.value = "found"
    session.set(LEO, "5 parsec")
    study._look()
    assert not study.button.enabled and "parsec" in study.fault.text
    asyncio.run(study._run())
    session.set(LEO, "6 cm")

    def full():
        raise OSError("the disk is full")

    monkeypatch.setattr(session, "save", full)
    asyncio.run(study._run())
    assert (asked.orders, told) == ([], ["the disk is full"])


def test_a_folder_that_was_typed_meanwhile_stays(session, tab, monkeypatch):
    study = runs._Study(session)

    async def slow(page, work, *args):
        study.folder.value = "mine"
        return work(*args)

    monkeypatch.setattr(runs, "in_thread", slow)
    asyncio.run(study._name())
    assert study.folder.value == "mine"


def test_a_campaign_is_run_from_a_file_or_goes_on_from_its_ledger(session, tab, asked, told):
    campaign = runs._Campaign(session)
    asyncio.run(campaign._look())
    assert not campaign.button.enabled
    campaign.ledger.value = "x.ledger"
    asyncio.run(campaign._run())
    said = "There is no campaign file in this folder yet; write an example, and change it."
    assert (campaign.fault.text, asked.orders) == (said, [])
    asyncio.run(campaign._example())
    assert (campaign.file.value, campaign.ledger.value) == ("campaign.toml", "campaign.ledger")
    assert campaign.button.enabled and campaign.ledger.enabled and campaign.fault.text == ""
    asyncio.run(campaign._run())
    (session.folder / "x.ledger").touch()
    asyncio.run(campaign._look())
    assert campaign.file.options == ["campaign.toml", "x.ledger (go on)"]
    assert campaign.file.value == "campaign.toml"
    campaign.file.value = "x.ledger (go on)"
    asyncio.run(campaign._name())
    assert (campaign.ledger.value, campaign.ledger.enabled) == ("x.ledger", False)
    asyncio.run(campaign._run())
    assert [each.arguments for each in asked.orders] == [
        commands.campaign(Path("campaign.toml"), Path("campaign.ledger")).arguments,
        commands.resume(Path("x.ledger")).arguments,
    ]
    assert {each.kind for each in asked.orders} == {"campaign"}
    (session.folder / "x.ledger").unlink()
    (session.folder / "campaign.ledger").touch()
    asyncio.run(campaign._look())
    assert (campaign.file.value, campaign.ledger.value) == ("campaign.toml", "campaign-2.ledger")
    for wrong, words in (("../x", "holds a path; choose another name"), (None, "it has no name")):
        campaign.ledger.value = wrong
        asyncio.run(campaign._run())
        assert words in campaign.fault.text
    assert len(asked.orders) == 2


def test_an_example_that_was_written_is_chosen(session, tab):
    (session.folder / "a.toml").write_text('mission = "leo-geo.toml"', "utf-8")
    campaign = runs._Campaign(session)
    asyncio.run(campaign._look())
    assert campaign.file.value == "a.toml"
    asyncio.run(campaign._example())
    assert campaign.file.value == "campaign.toml"


def test_an_example_that_cannot_be_written_says_why(session, tab):
    campaign = runs._Campaign(session)
    session.change(Draft.shipped(session.inside("unsaved.toml")))
    asyncio.run(campaign._example())
    assert campaign.fault.text.startswith("unsaved.toml is not saved yet")
    assert campaign.file.value is None


@pytest.mark.parametrize(
    ("state", "code", "look"),
    [
        ("done", 0, "yes"),
        ("done", 1, "no"),
        ("failed", 2, "no"),
        ("lost", None, "no"),
        ("unreadable", None, "no"),
        ("cancelled", 130, "soft"),
        ("queued", None, "soft"),
        ("running", None, "soft"),
    ],
)
def test_the_state_of_a_job_has_a_colour(tmp_path, state, code, look):
    assert runs_jobs._class(Job(1, tmp_path, state, code=code)) == look


@pytest.fixture
def cards(session, tab, monkeypatch):
    """A list of jobs whose cards are made by hand; the first has printed something."""
    monkeypatch.setattr(session.jobs, "output", lambda number: " said\n" if number == 1 else "")
    return runs_jobs.JobList(session, lambda address, title: None)


def shown(card, job, beside=Others()):  # noqa: B008
    asyncio.run(card.show(job, beside))
    return card


def test_a_card_shows_what_a_job_is_and_can(session, cards):
    job = Job(
        1, session.folder, "queued", "study", "mine", ("run", "m.toml"), session.folder, queued="2026-03-20T12:00:00Z"
    )
    card = shown(runs_jobs._Card(cards, job), job)
    assert {"1. mine", "microrad run m.toml"} <= set(texts(card.element))
    assert (card.bar.visible, card.cancel.visible, card.drop.visible, card.details.visible) == (
        False,
        True,
        False,
        False,
    )
    assert card.state.text == "waiting for the job before it"
    running = replace(job, state="running", progress=Progress(1, 4, "rows"), started="2026-03-20T12:00:00Z")
    shown(card, running)
    assert (card.bar.visible, card.bar.value, card.progress.text) == (True, 0.25, "25 %, 1 of 4 rows")
    assert card.cancel.visible and not card.drop.visible and not card.fault.visible
    shown(card, replace(running, cancelling=True))
    assert (card.cancel.visible, card.drop.visible, card.state.text) == (False, False, "stopping ...")
    failed = replace(running, state="failed", code=2, words="the reason")
    shown(card, failed)
    assert (card.cancel.visible, card.drop.visible, card.bar.visible) == (False, True, False)
    assert (card.fault.text, card.fault.visible, card.said.text, card.details.visible) == (
        "the reason",
        True,
        "said",
        True,
    )
    assert "no" in card.state.classes and "soft" not in card.state.classes
    shown(card, replace(failed, words="another"))  # it had ended before
    assert card.details.visible


def test_a_job_that_printed_nothing_has_nothing_unfolded(session, cards):
    job = Job(2, session.folder, "done", "identification", "mine")
    card = shown(runs_jobs._Card(cards, job), job)
    assert not card.details.visible and "open" not in card.details.props
    study = runs_jobs._Card(cards, replace(job, kind="study"))
    assert "open" in study.details.props
    shown(card, replace(job, title="x"))
    assert not card.details.visible


def test_results_of_a_job_are_shown_here_or_saved(session, cards):
    for name in ("page.html", "x.nc"):
        (session.folder / name).touch()
    job = Job(1, session.folder, "done", "study", "t", (), session.folder, ("x.nc", "none.nc", "page.html"))
    card = shown(runs_jobs._Card(cards, job), job)
    assert texts(card.results) == ["Save x.nc", "Show page.html here", "page.html in a tab of its own"]
    assert card.results.visible
    links = [each.props["href"] for each in card.results.descendants() if isinstance(each, ui.link)]
    assert links == ["/results/1/0", "/results/1/2"]


@pytest.mark.parametrize(
    ("state", "there", "beside", "visible", "opens"),
    [
        ("running", True, {"newest": True, "latest": True}, ("figures",), True),
        ("running", False, {"newest": True, "latest": False}, ("figures",), True),
        ("queued", False, {"newest": True, "latest": True}, (), None),
        ("queued", True, {"newest": True, "latest": False}, ("figures",), False),
        ("done", True, {"newest": True, "latest": True}, ("figures", "page"), True),
        ("done", True, {"newest": True, "latest": False}, ("figures", "page"), False),
        ("done", False, {"newest": True, "latest": True}, (), None),
        ("cancelled", True, {"newest": True, "latest": False}, ("figures", "again"), False),
        ("failed", True, {"newest": True, "latest": True}, ("figures", "again"), True),
        ("lost", True, {"newest": True, "latest": True}, ("figures", "again"), True),
        ("lost", False, {"newest": True, "latest": True}, (), None),
        ("done", True, {}, (), None),
    ],
)
def test_a_campaign_shows_its_figures_and_the_way_on(session, cards, state, there, beside, visible, opens):
    if there:
        (session.folder / "x.ledger").touch()
    job = Job(2, session.folder, state, "campaign", "t", ("campaign",), session.folder, ("x.ledger",))
    card = shown(runs_jobs._Card(cards, job), job, Others(**beside))
    assert tuple(name for name in ("figures", "page", "again") if getattr(card, name).visible) == visible
    assert (None if card._panel is None else card._panel.open) == opens
    assert card.figures.text == ("Hide its figures" if opens else "Show its figures")
    assert card.results.visible == bool(beside)
    card._toggle()
    assert (None if card._panel is None else card._panel.open) == (None if opens is None else not opens)
    assert card.figures.text == ("Show its figures" if opens or opens is None else "Hide its figures")
    if card._panel is not None:
        card._panel.open = True
        shown(card, replace(job, title="x"), Others())  # another job goes on with the ledger
        assert (card._panel.open, card.figures.text) == (False, "Show its figures")


def test_a_report_of_a_campaign_is_linked_once_it_is_written(session, cards):
    (session.folder / "x.ledger").touch()
    job = Job(2, session.folder, "done", "campaign", "t", ("campaign",), session.folder, ("x.ledger",))
    card = runs_jobs._Card(cards, job)
    report = Job(3, session.folder, "running", "export", results=("x.html",))
    shown(card, job, Others(newest=True, report=report))
    assert (texts(card.report), card.page.visible) == (["Its report is written by job 3: running"], False)
    shown(card, job, Others(newest=True, report=replace(report, state="done")))
    assert texts(card.report) == ["Show x.html here", "x.html in a tab of its own"]
    shown(card, job, Others(newest=True))
    assert (texts(card.report), card.page.visible) == ([], True)


def test_a_card_without_a_job_yet_has_no_ledger_to_go_on_from(session, cards, asked):
    job = Job(2, session.folder, "cancelled", "campaign", "t", ("campaign",), session.folder, ("x.ledger",))
    card = runs_jobs._Card(cards, job)
    asyncio.run(card._go_on())
    assert asked.orders == []
    shown(card, replace(job, kind="study"))
    asyncio.run(card._go_on())
    assert asked.orders == []
    shown(card, job)
    asyncio.run(card._go_on())
    assert [order.arguments for order in asked.orders] == [commands.resume(Path("x.ledger")).arguments]


def test_the_list_has_a_card_for_each_job_the_newest_first(session, cards, monkeypatch):
    one, two = (Job(number, session.folder, "queued", "study", f"job {number}") for number in (1, 2))
    for jobs, left in (((), []), ((one,), [1]), ((two, one), [2, 1]), ((two,), [2]), ((), [])):
        monkeypatch.setattr(session.jobs, "listed", lambda jobs=jobs: jobs)
        asyncio.run(cards.refresh())
        headings = [text for text in texts(cards._place) if ". job" in text]
        assert headings == [f"{number}. job {number}" for number in left]
        assert cards._empty.visible == (not jobs)

    async def twice():
        async with cards._busy:
            monkeypatch.setattr(session.jobs, "listed", lambda: (one,))
            await asyncio.wait_for(cards.refresh(), 5.0)  # and not wait for the other one

    asyncio.run(twice())
    assert cards._cards == {}


def found_figures(*names):
    return Figures("Of 3 rows so far", "So far", (Soft("told"),), {name: empty(name) for name in names})


def test_the_figures_of_a_campaign_keep_what_was_chosen(session, tab, monkeypatch):
    panel = runs_jobs.CampaignPanel(session, session.folder / "x.ledger")
    drawn = []
    monkeypatch.setattr(panel._plot, "show", drawn.append)
    assert (panel.open, panel._drawn.visible, panel._fault.visible) == (False, False, False)
    panel._draw()
    assert drawn == []
    panel._show(found_figures("a"))
    assert (panel._chosen.value, panel._chosen.visible, panel._drawn.visible) == ("a", False, True)
    assert panel._plot.props["aria-label"] == "Distribution over the rows: a"
    panel._show(found_figures("a", "b"))
    panel._chosen.value = "b"
    panel._show(found_figures("c", "b"))
    assert (panel._chosen.value, panel._chosen.visible) == ("b", True)
    assert panel._plot.props["aria-label"] == "Distribution over the rows: b"
    panel._show(found_figures("c", "d"))
    assert panel._chosen.value == "c"
    before = len(drawn)
    panel._show(found_figures())
    assert (panel._chosen.value, panel._drawn.visible, len(drawn)) == (None, False, before)
    assert (panel._rows.text, panel._headline.text) == ("Of 3 rows so far", "So far")
    panel._clear("No row is in the ledger yet.")
    assert (panel._rows.text, panel._headline.visible) == ("No row is in the ledger yet.", False)


def test_a_panel_tells_the_fault_of_its_ledger(session, tab, monkeypatch):
    panel = runs_jobs.CampaignPanel(session, session.folder / "x.ledger")
    live = SimpleNamespace(fault="damaged")
    looked = []
    monkeypatch.setattr(session.campaigns, "look", lambda path: live)
    monkeypatch.setattr(runs_jobs, "figures", lambda live: looked.append(live) or found_figures("a"))
    asyncio.run(panel._look())
    asyncio.run(panel._look())
    assert (looked, panel._fault.text, panel._fault.visible) == ([live], "damaged", True)
    live = SimpleNamespace(fault="")
    monkeypatch.setattr(runs_jobs, "figures", lambda live: None)
    asyncio.run(panel._look())
    assert (panel._fault.visible, panel._rows.text) == (False, "No row is in the ledger yet.")


# -------------------------------------------------------------------------------------------------------------- control
class Found(SimpleNamespace):
    """A controller, as far as the page asks it."""


def controller(name, **more):
    given = {"name": name, "rate_hz": 5000.0, "sensitivity": None, "loop_gain": None, "warnings": ()}
    return Found(**(given | {"ask": lambda ask, variants: (ask, variants)} | more))


@pytest.fixture
def controls(session, tab, monkeypatch):
    """The page of the controllers; `made` are what it had tuned, `drawn` the answers that it drew."""
    made, drawn = [], []

    def built(file, name):
        made.append(name)
        if name in refusals:
            raise ValueError(f"{name}: no")
        return controller(name)

    refusals = set()
    monkeypatch.setattr(control, "_controller", built)
    monkeypatch.setattr(control, "_names", lambda table: ("baseline", "PI", "PID", "inverse"))
    monkeypatch.setattr(control, "_blocks", lambda found: tuple(Soft(f"{k}: {v}") for k, v in found.items()))
    monkeypatch.setattr(control.ControlPage, "_controller", lambda self, found: drawn.append(found.name))
    monkeypatch.setattr(control.ControlPage, "_answers", lambda self, found, answers: drawn.append(answers))
    page = control.ControlPage(session)
    page.made, page.drawn, page.refusals = made, drawn, refusals
    return page


def behind(page):
    return {name for name, plot in page.plots.items() if "behind" in plot.classes}


def test_the_controllers_of_a_mission_are_offered_and_one_of_them_is_shown(session, controls):
    page = controls
    assert page.file is None
    asyncio.run(page.tune_all())
    asyncio.run(page.show())
    assert page.made == []
    asyncio.run(page.reload())
    assert (page.name.options, page.name.value) == (["baseline", "PI", "PID", "inverse"], "PI")
    scenario = page.file.mission.scenario
    assert page.amplitude.value == f"{1e6 * scenario.amplitude_rad:g} urad"
    assert page.frequency.value == f"{scenario.pid_frequencies_hz[-1]:g} Hz"
    assert (page.made, page.drawn[0]) == (["PI"], "PI")
    ask, variants = page.drawn[1]
    assert (ask.step_rad, variants) == (pytest.approx(1e-4), control.control_view.SHOWN["both"])
    assert page.found["baseline"] == "not looked at yet"
    before = page.round
    asyncio.run(page.reload())
    assert (page.made, page.round) == (["PI"], before)  # nothing is new


def test_what_was_chosen_and_typed_stays_for_another_mission(session, controls, monkeypatch):
    page = controls
    asyncio.run(page.reload())
    page.filling = True  # no task for what is put in by hand
    page.name.value, page.amplitude.value, page.variants.value = "PID", "7 urad", "with"
    page.filling = False
    session.set(LEO, "6 cm")
    asyncio.run(page.reload())
    assert (page.name.value, page.amplitude.value, page.made) == ("PID", "7 urad", ["PI", "PID"])
    assert page.drawn[-1][1] == control.control_view.SHOWN["with"]
    monkeypatch.setattr(control, "_names", lambda table: ("one", "two", "three"))
    session.set(LEO, "7 cm")
    asyncio.run(page.reload())
    assert page.name.value == "one"  # of so few the first
    session.set(LEO, "7 parsec")
    asyncio.run(page.reload())
    assert "parsec" in page.words.text
    assert page.name.value == "one" and page.made == ["PI", "PID", "one"]


def test_a_controller_that_cannot_be_built_says_why_in_its_row(session, controls):
    page = controls
    page.refusals.add("PI")
    asyncio.run(page.reload())
    assert page.found["PI"] == "PI: no"
    assert page.fault.text == "PI cannot be built for this mission; the table says why."
    assert (behind(page), page.state.text, page.drawn) == (set(page.plots), "", [])
    page.refusals.clear()
    asyncio.run(page.show())
    assert (behind(page), page.fault.text, page.state.text) == (set(), "", "")
    page.step.value = "5 V"
    asyncio.run(page.show())
    assert page.fault.text.startswith("step: ")
    assert behind(page) == set(page.plots) - {"sensitivity", "gain"}
    assert "behind" not in page.notes.classes and "behind" in page.told_step.classes


def test_grey_plots_make_the_words_and_notes_about_them_grey(controls):
    for plots, told, notes in ((["step"], True, False), (["gain", "step"], True, True), ([], False, False)):
        controls._dim(plots)
        assert behind(controls) == set(plots)
        assert ("behind" in controls.told_sine.classes, "behind" in controls.notes.classes) == (told, notes)


def test_all_controllers_are_tuned_one_after_the_other_until_that_is_stopped(session, controls, monkeypatch):
    page = controls
    asyncio.run(page.reload())
    page.made.clear()
    page.refusals.add("PID")
    asyncio.run(page.tune_all())
    assert page.made == ["baseline", "PI", "PID", "inverse"]
    assert (page.tune.visible, page.stop.visible, page.found["PID"]) == (True, False, "PID: no")
    assert page.found["PI"].name == "PI"
    page.made.clear()

    async def stopped(element, work, *args):
        if page.made:
            page.stop_all()
        return work(*args)

    monkeypatch.setattr(control, "in_thread", stopped)
    asyncio.run(page.tune_all())
    assert page.made == ["baseline", "PI"]
    assert (page.tune.visible, page.stop.visible) == (True, False)


def test_an_answer_to_an_older_question_is_not_shown(session, controls, monkeypatch):
    page = controls
    asyncio.run(page.reload())
    page.drawn.clear()

    async def late(element, work, *args):
        page.question += 1
        return work(*args)

    monkeypatch.setattr(control, "in_thread", late)
    asyncio.run(page.show())
    assert page.drawn == []
    monkeypatch.setattr(control, "in_thread", here)

    async def later(element, work, *args):
        if work is not control._controller:
            page.question += 1
        return work(*args)

    monkeypatch.setattr(control, "in_thread", later)
    asyncio.run(page.show())
    assert page.drawn == ["PI"]


def test_a_controller_of_the_mission_before_does_not_get_a_row(session, controls):
    page = controls
    asyncio.run(page.reload())
    asyncio.run(page._tuned(object(), "baseline"))
    assert page.found["baseline"] == "not looked at yet"


# ------------------------------------------------------------------------------------------------------------------ day
@pytest.fixture
def days(session, tab, monkeypatch):
    """The page of the day, whose questions are kept and not answered."""
    page = day.DayPage(session)
    page.asked = []
    monkeypatch.setattr(page, "latest", SimpleNamespace(ask=lambda key, work: page.asked.append(key), state=State()))
    return page


@pytest.mark.parametrize(
    ("state", "words", "share"),
    [
        ({}, "Not computed.", 0.0),
        ({"running": True}, "Computing, links", 0.0),
        ({"running": True, "done": 1, "total": 4, "what": "passes"}, "Computing, passes: 1 of 4", 0.25),
        ({"error": "no orbit"}, "no orbit", 0.0),
        ({"result": (1,)}, "The day of the mission before this.", 0.0),
        ({"result": (1,), "now": True}, "The day of the mission as it stands.", 0.0),
        ({"now": True}, "Not computed.", 0.0),
    ],
)
def test_the_day_says_how_far_it_is_and_whose_it_is(session, days, state, words, share):
    now = state.pop("now", False)
    for faulty in (False, True):
        days.faults.visible = faulty
        days._show_progress(State(session.draft.sha256 if now else "before", **state))
        assert (days.state.text, days.bar.value) == (words, share)
        running, known = state.get("running", False), "result" in state
        assert days.bar.visible == days.cancel.visible == running
        assert days.again.visible == (not running and not known and not faulty)
        assert ("behind" in days.results.classes) == (not (now and known))


def test_the_day_of_a_mission_that_has_none_is_not_asked_for(session, days):
    days.reload()
    assert (days.asked, days.faults.visible, days.faults.text) == ([session.draft.sha256], False, "")
    session.set(LEO, "5 parsec")
    days.reload()
    assert len(days.asked) == 1 and days.faults.visible and "parsec" in days.faults.text
    session.change(session.draft.with_text(links_alone(TEXT)))
    days.reload()
    assert (len(days.asked), days.faults.visible) == (1, True)
    assert days.faults.text == day_view.missing(session.link()) != ""
    session.change(session.draft.with_text(TEXT))
    days.reload()
    assert (len(days.asked), days.faults.visible) == (2, False)


# --------------------------------------------------------------------------------------------------- links and pointing
@pytest.fixture
def links(session, tab, monkeypatch):
    """The page of the links, whose study is asked for by hand."""
    monkeypatch.setattr(layout, "follow", lambda session, show: lambda: None)
    page = link.LinkPage(session)
    page.asked, page.put = [], []
    page.study = SimpleNamespace(state=State(), ask=lambda key, work: page.asked.append(key))
    monkeypatch.setattr(link, "put", lambda table, of: page.put.append(of))
    monkeypatch.setattr(link, "_told", lambda result: ((Soft(result),), {}))
    return page


def test_the_budget_that_was_chosen_stays_while_the_mission_has_it(session, links, monkeypatch):
    page = links
    page._show_table()
    page._tabs()
    assert (page.put, page.which.options, page.which.value) == ([], [], None)
    page.view_now = link_view.view(session.link())
    page._tabs()
    assert page.which.options == ["Communication", "Beacon", "Answer"]
    assert (page.which.value, len(page.put)) == ("Communication", 2)
    page.which.value = "Answer"
    page.view_now = replace(page.view_now, budgets=page.view_now.budgets[::2])
    page._tabs()
    assert (page.which.options, page.which.value) == (["Communication", "Answer"], "Answer")
    page.view_now = replace(page.view_now, budgets=page.view_now.budgets[:1])
    page._tabs()
    assert page.which.value == "Communication"
    assert page.put[-1].title == page.put[0].title


@pytest.mark.parametrize(
    ("state", "shown", "words", "grey"),
    [
        ({}, "", "", True),
        ({"running": True}, "", "Computing acquisition and what moves the margins ...", True),
        ({"error": "no light"}, "", "no light", True),
        ({"error": "no light"}, "x", "no light", True),
        ({"result": "r", "key": "before"}, "before", "Of the mission before this:", True),
        ({"result": "r", "key": "now"}, "", "", False),
        ({"key": "now"}, "x", "Of the mission before this:", True),
    ],
)
def test_what_follows_from_the_links_is_that_of_the_mission_or_says_so(session, links, state, shown, words, grey):
    key = session.draft.sha256 if state.get("key") == "now" else state.get("key", "")
    links.shown = session.draft.sha256 if shown == "now" else shown
    links.study.state = State(**(state | {"key": key}))
    asyncio.run(links._look())
    assert (links.state.text, links.state.visible) == (words, bool(words))
    assert ("behind" in links.told.classes) == grey
    assert ("r" in texts(links.told)) == (state.get("result") is not None and key != shown)


def test_the_study_of_the_links_is_asked_for_once_the_mission_rests(session, links, monkeypatch):
    now = [100.0]
    monkeypatch.setattr(link, "time", SimpleNamespace(monotonic=lambda: now[0]))
    links._ask_study()
    now[0] += link._REST_S
    links._ask_study()
    assert links.asked == []
    now[0] += 0.01
    links._ask_study()
    assert links.asked == [session.draft.sha256]
    links.study.state = State(session.draft.sha256)
    links._ask_study()
    assert len(links.asked) == 1
    session.set(LEO, "5 parsec")
    links._ask_study()
    now[0] += 2.0 * link._REST_S
    links._ask_study()
    assert len(links.asked) == 1  # a mission with faults has none


def test_a_budget_of_errors_that_comes_late_is_not_shown(session, tab, monkeypatch):
    monkeypatch.setattr(layout, "follow", lambda session, show: lambda: None)
    page = pointing.PointingPage(session)
    view = SimpleNamespace(file=None)
    monkeypatch.setattr(pointing, "_budget", lambda file, table: View("", [Soft(table)]))
    page.view_now, page.state.text = object(), "Computing ..."
    asyncio.run(page._errors(view, "late"))
    assert (page.state.text, texts(page.budget)) == ("Computing ...", [])
    page.view_now = view
    asyncio.run(page._errors(view, "in time"))
    assert (page.state.text, texts(page.budget)) == ("", ["in time"])

    def refuse(file, table):
        raise ValueError("of several axes")

    monkeypatch.setattr(pointing, "_budget", refuse)
    page.state.text = "Computing ..."
    asyncio.run(page._errors(view, ""))
    assert (page.state.text, texts(page.budget)) == ("", ["of several axes"])


# -------------------------------------------------------------------------------------------------------------- sliders
class Board(sliders.SliderPage):
    """A page of sliders whose view is the file itself."""

    def build(self):
        self.shows = []
        self.label = ui.label()
        self.dimmed = (self.label,)

    async def show(self, view):
        self.shows.append(view)

    def show_rest(self, view):
        self.shows.append("rest")


@pytest.fixture
def board(session, tab, monkeypatch):
    monkeypatch.setattr(layout, "follow", lambda session, show: lambda: None)
    monkeypatch.setattr(sliders, "pause", lambda page, seconds: asyncio.sleep(0))
    return Board(session, link_view.sliders, lambda file: file)


def test_a_view_is_shown_once_and_a_mission_without_one_says_why(session, board):
    draft, wrong = session.draft, session.draft.set(LEO, "5 parsec")

    def answer(*found):
        asyncio.run(board._answer(Attempt(*found)))
        return board._faults.text, board._faults.visible, "behind" in board.label.classes, len(board.shows)

    board.board.show(link_view.sliders(draft))
    first, visible, grey, count = answer(wrong, None)
    assert (first, visible, grey, count) == (sliders._NONE, True, True, 0)  # the fault stands beside its slider
    assert answer(draft, 1)[1:] == (False, False, 1)
    assert board.shows == [1] and board.view_now == 1
    assert answer(draft, 2)[1:] == (False, False, 1)  # of the same text
    assert answer(draft, None, "no light")[:3] == (f"{sliders._OLD}\nno light", True, True)
    assert answer(draft, 3)[1:] == (False, False, 2)
    unknown = draft.with_text(draft.text + "[more]\nx = 1\n")
    words = answer(unknown, None)[0].split("\n")
    assert words[0] == sliders._OLD and "more" in words[1]
    assert answer(unknown, 4)[1:] == (False, False, 3)


def test_what_is_read_is_shown_for_the_view_that_stands(board):
    board.view_now = view = object()
    asyncio.run(board._rest(object()))
    assert board.shows == []
    asyncio.run(board._rest(view))
    assert board.shows == ["rest"]


def test_a_slider_that_is_let_go_where_it_was_writes_nothing(session, tab, monkeypatch):
    tried, written = [], []

    async def attempt(key, typed):
        tried.append(typed)

    async def write(key, typed):
        written.append(typed)
        if typed == "8 cm":
            row._begin("9 cm")  # it is moved again meanwhile

    row = sliders.SliderRow(link_view.sliders(session.draft)["Telescopes"][0], attempt, write)
    monkeypatch.setattr(row, "run_method", lambda *sent: None)
    asyncio.run(row._let_go("5 cm"))
    assert (written, row.busy) == ([], False)
    asyncio.run(row._tried("6 cm"))
    assert (tried, row.busy, row.typed) == (["6 cm"], True, "6 cm")
    asyncio.run(row._let_go("5 cm"))
    assert (written, row.busy) == (["5 cm"], False)  # it was moved, and back
    asyncio.run(row._let_go("7 cm"))
    assert (written[-1], row.busy, row.slider.typed) == ("7 cm", False, "7 cm")
    asyncio.run(row._let_go("8 cm"))
    assert (row.busy, row.typed) == (True, "9 cm")
    row.show(replace(row.slider, typed="5 cm"))
    assert row.typed == "9 cm"  # what is being moved stays
    row.busy = False
    row.show(replace(row.slider, typed="5 cm"))
    assert (row.typed, row.slider.typed) == ("5 cm", "5 cm")


# --------------------------------------------------------------------------------------------------------------- mirror
CHANNELS = Listing((ChannelInfo("drive [V]", "", 9), ChannelInfo("angle [mrad]", "", 9)), None, (200.0,))


@pytest.fixture
def bench(session, tab, monkeypatch):
    """The page of the mirror with recordings that are read at once; `files` are what lies in the folder."""
    monkeypatch.setattr(mirror.reading, "list_channels", lambda path: answers.get(path.name, CHANNELS))
    monkeypatch.setattr(mirror.reading, "view", lambda path, columns: seen.append((path.name, columns)) or READ)
    monkeypatch.setattr(mirror.mirror_view, "recording_plot", lambda view, setting: empty("loop"))
    monkeypatch.setattr(mirror.mirror_view, "time_plot", lambda view, setting: empty("time"))
    answers, seen, files = {}, [], {}
    page = mirror.MirrorPage(session)

    def listed():
        return tuple(files.values())

    def remove(key):
        del files[key]

    uploads = SimpleNamespace(listed=listed, get=files.__getitem__, remove=remove)
    monkeypatch.setattr(page, "uploads", uploads)
    page.files, page.read, page.answers = files, seen, answers
    return page


READ = Read(300, 100.0, ("it drifts",), (0, 1), ((0.0, 1.0),), ((0.0, 1.0),))


def put_in(page, *names):
    for name in names:
        path = page.session.folder / "up" / name
        page.files[name[0]] = SimpleNamespace(key=name[0], name=name, path=path, size=1)


def test_a_recording_that_comes_is_shown_and_measured(bench):
    put_in(bench, "a.csv")
    asyncio.run(bench.take(bench.files["a"]))
    assert bench.form.seen == "a"
    assert (bench.fields["drive"].value, bench.fields["output"].value) == (0, 1)
    assert bench.fields["drive"].options == mirror_form.labels(CHANNELS)
    assert [name for name, _ in bench.read] == ["a.csv"]
    assert bench.about.text == "300 samples at 100 Hz, 3 s."
    assert texts(bench.findings) == ["It drifts."]
    assert [each.text for each in bench.list.descendants() if "seen" in getattr(each, "classes", ())] == ["a.csv"]
    asyncio.run(bench._measured())
    assert len(bench.read) == 1  # it is shown already
    put_in(bench, "b.csv")
    asyncio.run(bench.take(bench.files["b"]))
    assert (bench.form.seen, bench.form.setting.name) == ("b", "a-mirror")
    assert "b.csv" in texts(bench.list)


def test_a_file_that_is_no_recording_is_thrown_away_in_words(bench, monkeypatch):
    def refuse(path):
        raise mirror.reading.ReadingError("a.csv: the file is empty")

    put_in(bench, "a.csv")
    with monkeypatch.context() as patch:
        patch.setattr(mirror.reading, "list_channels", refuse)
        asyncio.run(bench.take(bench.files["a"]))
    assert (bench.refused.text, bench.files, bench.form.seen) == ("a.csv: the file is empty", {}, "")
    put_in(bench, "b.csv")
    asyncio.run(bench.take(bench.files["b"]))
    assert bench.refused.text == ""


def test_the_other_recordings_are_read_one_by_one_but_for_those_left_out(bench):
    put_in(bench, "a.csv", "b.csv", "c.csv", "d.csv")
    asyncio.run(bench.check())
    assert bench.read == []  # no channel is chosen yet
    asyncio.run(bench.take(bench.files["a"]))
    bench.use("b", "leave")
    for _ in range(4):
        asyncio.run(bench.check())
    assert [name for name, _ in bench.read] == ["a.csv", "c.csv", "d.csv"]


def test_the_fault_of_a_recording_stands_below_it_unless_it_is_left_out(bench, monkeypatch):
    def refuse(path, columns):
        raise mirror.reading.ReadingError(f"{path.name}: odd")

    put_in(bench, "a.csv", "b.csv")
    asyncio.run(bench.take(bench.files["a"]))
    monkeypatch.setattr(mirror.reading, "view", refuse)
    asyncio.run(bench.check())
    asyncio.run(bench.look())
    assert "b.csv: odd" in texts(bench.list)
    bench.use("b", "leave")
    asyncio.run(bench.look())
    assert "b.csv: odd" not in texts(bench.list)


def test_what_cannot_be_measured_says_why_and_shows_nothing(bench, monkeypatch):
    shows = []
    monkeypatch.setattr(bench.loop, "show", shows.append)
    put_in(bench, "a.csv")
    asyncio.run(bench.take(bench.files["a"]))
    assert shows == [empty("loop")]
    bench.keep(replace(bench.form, setting=replace(bench.form.setting, output=None)))
    asyncio.run(bench._measured())
    assert (bench.words.text, bench.about.text, texts(bench.findings)) == ("output: choose the channel", "", [])
    assert shows[1] == mirror.mirror_view.nothing()
    assert not bench.action()
    asyncio.run(bench.start())
    asyncio.run(bench.remove("a"))
    assert (bench.form.seen, bench.fields["drive"].options) == ("", {})


def test_a_late_answer_about_a_recording_is_dropped(bench, monkeypatch):
    shows = []
    put_in(bench, "a.csv")
    monkeypatch.setattr(bench, "_show", lambda *found: shows.append(found))

    async def late(key, setting):
        bench.question += 1
        return None, ""

    monkeypatch.setattr(bench, "_look_into", late)
    asyncio.run(bench._measured())
    assert shows == []


def test_what_is_typed_in_the_form_is_taken_over_and_kept(bench):
    put_in(bench, "a.csv")
    asyncio.run(bench.take(bench.files["a"]))
    bench.filling = True
    assert bench.typed() is None
    bench.fields["output_unit"].value, bench.fields["rate"].value = "um", "5 kHz"
    bench.fields["accept"].value = None
    bench.filling = False
    asyncio.run(bench.typed())
    setting = mirror_form.kept_form(bench.path).setting
    assert (setting.output_unit, setting.rate, setting.accept) == ("um", "5 kHz", ())
    assert bench.fields["lever_arm"].enabled
    bench.filling = True
    bench.fields["accept"].value, bench.fields["output_unit"].value = ["drift"], "urad"
    bench.filling = False
    asyncio.run(bench.typed())
    assert bench.form.setting.accept == ("drift",)
    assert not bench.fields["lever_arm"].enabled and not bench.filling


def test_what_another_tab_typed_is_shown_unless_it_cannot_be_kept_here(bench):
    mirror_form.keep_form(bench.path, Form(Setting(name="theirs")))
    bench.kept = False
    asyncio.run(bench.look())
    assert bench.form.setting.name == "mirror"
    bench.kept = True
    asyncio.run(bench.look())
    assert (bench.form.setting.name, bench.fields["name"].value) == ("theirs", "theirs")


def test_the_recording_that_is_shown_is_one_that_is_there(bench):
    put_in(bench, "a.csv", "b.csv")
    asyncio.run(bench.look())
    assert bench.form.seen == "b"
    bench.keep(replace(bench.form, seen="gone"))
    asyncio.run(bench.look())
    assert bench.form.seen == "b"
    asyncio.run(bench.see("a"))
    asyncio.run(bench.look())
    assert bench.form.seen == "a"


@pytest.mark.parametrize(("name", "told"), [('a"b.csv', "a b.csv"), ("µ_1-2.x y", "µ_1-2.x y"), ("<i>", " i ")])
def test_a_name_inside_of_a_property_is_harmless(name, told):
    assert mirror._attribute(name) == told


# ---------------------------------------------------------------------------------------------------- an identification
def fits(*names, loops=1):
    """Each leaves less than the one before of what no fit has seen."""
    seen = tuple(SimpleNamespace(name=f"{k}.csv") for k in range(loops))
    return tuple(SimpleNamespace(model=name, loops=seen, held_out_rms_percent=5.0 - n) for n, name in enumerate(names))


@pytest.fixture
def job_view(session, tab, monkeypatch):
    """The panel of the identifications; `drawn` are model and recording as they were drawn."""
    view = mirror_job.JobView(session)
    view.jobs, view.read, view.drawn_fits, view.end_of = [], {}, [], None
    monkeypatch.setattr(session.jobs, "listed", lambda: tuple(view.jobs))
    monkeypatch.setattr(session.jobs, "output", lambda number: "")
    monkeypatch.setattr(mirror_job.mirror_view, "read_fits", lambda folder: view.read.get(folder.name, ()))
    monkeypatch.setattr(mirror_job.mirror_view, "score_rows", lambda fits, chosen: [])
    monkeypatch.setattr(mirror_job.mirror_view, "state_words", lambda job, best: f"{job.state} {best and best.model}")
    monkeypatch.setattr(mirror_job.mirror_view, "outcome", lambda text: view.end_of)
    monkeypatch.setattr(
        mirror_job.mirror_view, "loop_plot", lambda fit, k, unit: view.drawn_fits.append((fit.model, k, unit)) or {}
    )
    monkeypatch.setattr(mirror_job.mirror_view, "residual_plot", lambda fit, k: {})
    return view


def identified(folder, number, state="running", **more):
    given = {"arguments": ("identify", "a", "--input-unit", "mV"), "results": ("stage.toml", "stage.html")}
    return Job(number, folder / str(number), state, "identification", f"job {number}", **(given | more))


def test_the_newest_identification_is_shown_until_another_one_is_chosen(session, job_view):
    view = job_view
    asyncio.run(view.look())
    assert (view.which.visible, view.number) == (False, 0)
    view.jobs = [Job(9, session.folder, "running", "study"), identified(session.folder, 2)]
    asyncio.run(view.look())
    assert (view.number, view.which.visible, view.which.options) == (2, False, {2: "2: job 2 (running)"})
    assert view.bar.visible and view.cancel.visible and not view.live.visible
    view.jobs.append(identified(session.folder, 1, "done"))
    asyncio.run(view.look())
    assert (view.number, view.which.visible, view.which.value) == (2, True, 2)
    for value, number in ((None, 2), (2, 2), (1, 1)):
        asyncio.run(view.choose(SimpleNamespace(value=value)))
        assert (view.number, view.which.value) == (number, number)
    assert not view.bar.visible and not view.cancel.visible
    view.jobs.pop()
    asyncio.run(view.look())
    assert view.number == 2


def test_a_model_and_a_recording_are_drawn_as_they_were_chosen(session, job_view):
    view = job_view
    view.jobs, view.read = [identified(session.folder, 1, progress=Progress(1, 4, "x"))], {"1": fits("a", "b", loops=2)}
    asyncio.run(view.look())
    assert view.drawn_fits == [("b", 0, "mV")]  # the best so far
    assert (view.bar.value, view.live.visible, view.recording.visible) == (0.25, True, True)
    assert view.model.options == {-1: "best so far", 0: "a", 1: "b"}
    view.draw()
    assert len(view.drawn_fits) == 1  # it is drawn already
    view.model.value = 0
    view.draw()
    view.recording.value = 1
    view.draw()
    assert view.drawn_fits[-2:] == [("a", 0, "mV"), ("a", 1, "mV")]
    view.read = {"1": fits("a", loops=1)}
    asyncio.run(view.look())
    assert (view.recording.value, view.recording.visible) == (0, False)
    assert view.drawn_fits[-1][:2] == ("a", 0)


def test_an_identification_that_has_found_a_mirror_leads_into_the_mission(session, job_view, told, monkeypatch):
    view, said = job_view, []
    view.jobs, view.read = [identified(session.folder, 1, "done")], {"1": fits("a", "b")}
    view.end_of = ("a", ("the verdict",))
    asyncio.run(view.look())
    assert (view.chosen, view.words.text, view.drawn_fits) == ("a", "done a", [("a", 0, "mV")])
    assert view.model.options[-1] == "the chosen one"
    assert texts(view.end) == ["Use this mirror in the mission", "Open the report", "Mirror file stage.toml"]
    monkeypatch.setattr(mirror_job.ui, "notify", lambda words, **how: said.append(words))
    view.use(session.folder / "stage.toml")
    assert 'file = "stage.toml"' in session.draft.text
    assert said == ["[mirror] of the mission names stage.toml now; save the mission to keep it."]
    monkeypatch.setattr(session, "edit", lambda how: session.inside("../x"))
    view.use(session.folder / "stage.toml")
    assert len(said) == len(told) == 1
    view.jobs = [identified(session.folder, 1, "failed")]
    asyncio.run(view.look())
    assert (view.chosen, texts(view.end)) == ("", [])


def test_an_identification_without_a_fit_yet_draws_nothing(session, job_view):
    job_view.draw()
    job_view.model.value = -1
    job_view.jobs = [identified(session.folder, 1, "done")]
    asyncio.run(job_view.look())
    assert (job_view.drawn_fits, job_view.chosen, job_view.bar.value) == ([], "", 0.0)


# ------------------------------------------------------------------------------------------- what the pages are made of
@pytest.mark.parametrize(
    ("name", "words", "said"),
    [
        ("a.csv", "refused", "a.csv: refused"),
        ("n" * 61, "w" * 401, f"{'n' * 60}: {'w' * 400}"),
        ("a.csv", "", "the file 'a.csv' has more than 200 MB; cut out the part"),
    ],
)
def test_a_file_that_the_page_has_stopped_says_why(tmp_path, name, words, said):
    found = []
    field = drop.Drop.__new__(drop.Drop)
    field._refused = found.append
    field._uploads = mirror.Uploads(tmp_path / "uploads", UploadLimits())
    field._unsent(SimpleNamespace(args=[name, words]))
    assert found[0].startswith(said)
    assert len(found[0]) == len(said) or not words


def test_a_file_is_stored_under_the_whole_name_that_it_was_sent_by(tmp_path):
    """A name with folders in it has to be refused where names are, so nobody may cut it before."""

    async def form(**_):
        return FormData([("file", UploadFile(io.BytesIO(b"1,2\n"), filename="../../x.csv"))])

    field = drop.Drop.__new__(drop.Drop)
    words = []
    field._refused, field._uploads = words.append, mirror.Uploads(tmp_path / "uploads", UploadLimits())
    assert asyncio.run(field._stored(SimpleNamespace(form=form))) == []
    assert "../../x.csv" in words[0]
    assert not list(tmp_path.rglob("x.csv"))


def test_blocks_of_the_same_form_change_in_place_and_others_are_built_anew(tab):
    made = elements.Blocks()
    made.show_blocks((Soft("one"), Verdict("good", (), True)))
    first = list(made.default_slot.children)
    assert [each.text for each in first] == ["one", "good"]
    made.show_blocks((Soft("two"), Verdict("better", (), True)))
    assert list(made.default_slot.children) == first
    assert [each.text for each in first] == ["two", "better"]
    made.show_blocks((Soft("two"),))
    assert len(made.default_slot.children) == 1 and made.default_slot.children[0] is not first[0]
    made.show_blocks((Points(("a", "b")), View("Title", (Table("", ("x",), [("1",)]),), folded=True)))
    assert texts(made)[:2] == ["a", "b"]


def test_a_picture_that_changes_is_shown_in_its_place(tab):
    drawing = Drawing("map", "A map", "its caption", "<svg/>")
    made = elements.Blocks()
    made.show_blocks((drawing,), {"map": "data:1"})
    (picture,) = (each for each in made.descendants() if "src" in each.props)
    assert (picture.props["src"], picture.props["alt"]) == ("data:1", "A map")
    made.show_blocks((drawing,), {"map": "data:2"})
    assert picture.props["src"] == "data:2"


def test_a_figure_begins_empty_or_with_what_it_is_given(tab):
    assert elements.Figure("of what").props["begin"] == empty("")
    given = elements.Figure("of what", empty("given"))
    assert (given.props["begin"], given.props["aria-label"]) == (empty("given"), "of what")


@pytest.mark.parametrize(
    ("deleted", "stopping", "cancelling", "ends"),
    [(False, False, 0, False), (True, False, 0, True), (False, True, 0, True), (False, False, 1, True)],
)
def test_whoever_waits_on_a_page_that_is_gone_is_ended(monkeypatch, deleted, stopping, cancelling, ends):
    monkeypatch.setattr(in_thread, "app", SimpleNamespace(is_stopping=stopping))
    for task in (SimpleNamespace(cancelling=lambda: cancelling), None):
        monkeypatch.setattr(in_thread.asyncio, "current_task", lambda task=task: task)
        gone = ends and not (task is None and cancelling)
        found = False
        try:
            in_thread.stay(SimpleNamespace(is_deleted=deleted))
        except asyncio.CancelledError:
            found = True
        assert found == gone


def test_the_files_of_an_identification_are_opened_by_their_links(session, job_view):
    """The report is the second of its results, the mirror file the first."""
    view = job_view
    view.jobs, view.read = [identified(session.folder, 7, "done")], {"7": fits("a")}
    view.end_of = ("a", ("the verdict",))
    asyncio.run(view.look())
    links = {each.text: each.props["href"] for each in view.end.descendants() if isinstance(each, ui.link)}
    assert links == {"Open the report": "/results/7/1", "Mirror file stage.toml": "/results/7/0"}


# ------------------------------------------------------------------------------------------ behind the first of a kind
def test_columns_of_a_table_have_their_heading_their_side_and_their_mark(tab):
    found = elements._columns(("name of it", "of it,\nµrad", "x"), numbers=(1,))
    assert [(each["name"], each["field"], each["label"], each["align"]) for each in found] == [
        ("c0", "c0", "Name of it", "left"),
        ("c1", "c1", "Of it, µrad", "right"),
        ("c2", "c2", "X", "left"),
    ]
    assert [each[":classes"] for each in found] == [
        "row => ` ${row.mark0 ?? ''}`",
        "row => `text-no-wrap ${row.mark1 ?? ''}`",
        "row => ` ${row.mark2 ?? ''}`",
    ]


def test_a_table_of_the_report_has_its_words_at_the_left_its_sums_and_its_marks(tab):
    made = elements.table(("a",))
    rows = [("p", "1", Cell("2", "PASS")), ("q", "3", "4"), ("sum", "5", Cell("6", "FAIL")), ("of", "7", "8")]
    elements.put(made, Table("", ("x", "y", "z"), rows, words=(0, 2), totals=2))
    assert [each["align"] for each in made.columns] == ["left", "right", "left"]
    assert made.rows == [
        {"id": 0, "total": False, "c0": "p", "c1": "1", "c2": "2 PASS", "mark2": "PASS"},
        {"id": 1, "total": False, "c0": "q", "c1": "3", "c2": "4"},
        {"id": 2, "total": True, "c0": "sum", "c1": "5", "c2": "6 FAIL", "mark2": "FAIL"},
        {"id": 3, "total": True, "c0": "of", "c1": "7", "c2": "8"},
    ]
    elements.put(made, Table("", ("y", "x", "z"), rows[:1], words=(0,)))
    assert [each["label"] for each in made.columns] == ["Y", "X", "Z"]
    assert [row["total"] for row in made.rows] == [False]


def headings(place):
    return [(each.tag, each.text) for each in place.descendants() if each.tag in ("h2", "h3", "h4")]


def test_views_within_views_are_headed_a_level_lower_each(tab):
    made = elements.Blocks()
    inner = View("inner", (Table("of its own", ("x",), [("1",)]), Soft("soft")))
    made.show_blocks((View("outer", (inner, Verdict("judged", (View("below", ()),), False))), View("next", ())))
    assert headings(made) == [("h2", "outer"), ("h3", "inner"), ("h4", "of its own"), ("h3", "below"), ("h2", "next")]
    (judged,) = (each for each in made.descendants() if getattr(each, "text", "") == "judged")
    assert "FAIL" in judged.classes
    looks = {Soft("s"): "soft", Verbatim("v"): "mono", Verdict("g", (), True): "PASS", "plain": None}
    made.show_blocks(tuple(looks))
    shown = list(made.default_slot.children)
    assert [each.text for each in shown] == ["s", "v", "g", "plain"]
    for each, look in zip(shown, looks.values(), strict=True):
        assert set(each.classes) & {"soft", "mono", "PASS", "FAIL"} == ({look} if look else set())


def test_what_is_folded_keeps_its_place_and_takes_other_words(tab):
    made = elements.Blocks()

    def blocks(n):
        rows = [(f"r{n}", str(n))]
        return (
            View(f"folded {n}" if n == 0 else "folded 0", (Points((f"a{n}", f"b{n}")),), folded=True),
            Table("t", ("x", "y"), rows, folded=f"{n} rows"),
            f"text {n}",
        )

    made.show_blocks(blocks(0))
    first, second = (each for each in made.descendants() if isinstance(each, ui.expansion))
    made.show_blocks(blocks(7))
    assert [each for each in made.descendants() if isinstance(each, ui.expansion)] == [first, second]
    assert (first.text, second.text) == ("folded 0", "7 rows")
    (table,) = (each for each in made.descendants() if isinstance(each, ui.table))
    assert table.rows[0] == {"id": 0, "total": False, "c0": "r7", "c1": "7"}
    assert [text for text in texts(made) if text[:1] in "ab"] == ["a7", "b7"]
    assert "text 7" in texts(made)


def test_the_second_figure_of_several_is_drawn_in_its_own_place(tab, monkeypatch):
    shows = []
    monkeypatch.setattr(elements.Figure, "show", lambda self, plot: shows.append((self.props["aria-label"], plot)))
    pictures = [Drawing(name, f"title {name}", f"caption {name}", "<svg/>") for name in "ab"]
    made = elements.Blocks()
    made.show_blocks((View("v", pictures),), {"a": empty("a1"), "b": "data:b1"})
    made.show_blocks((View("v", pictures),), {"a": empty("a2"), "b": "data:b2"})
    assert shows == [("title a", empty("a2"))]
    (picture,) = (each for each in made.descendants() if "src" in each.props)
    assert (picture.props["src"], picture.props["alt"]) == ("data:b2", "title b")
    assert [text for text in texts(made) if "caption" in text] == ["title a. caption a", "title b. caption b"]


def test_margins_are_sent_with_their_words_and_whether_they_are_met(tab, monkeypatch):
    sent = []
    cards = elements.MarginCards()
    monkeypatch.setattr(cards, "run_method", lambda *what: sent.append(what))
    cards.show((link_view.Margin("a", 1.5, 2.0, sign="!"), link_view.Margin("b", 2.5, 2.0)))
    assert sent == [
        (
            "show",
            [
                {"name": "a", "value": "+1.50 dB !", "needs": "needs 2 dB: MISSED", "met": False},
                {"name": "b", "value": "+2.50 dB", "needs": "needs 2 dB: met", "met": True},
            ],
        )
    ]


def test_the_day_that_was_asked_for_is_shown_once_with_its_figures(session, days, monkeypatch):
    shows = []
    monkeypatch.setattr(day.day_view, "blocks", lambda study, sources: (study, sources))
    monkeypatch.setattr(day, "drawn", lambda blocks: {"figure": blocks})
    monkeypatch.setattr(days.told, "show_blocks", lambda *given: shows.append(given))
    asyncio.run(days.look())
    assert (shows, days.results.visible) == ([], False)
    days.latest.state = State(session.draft.sha256, result=("study", "sources"))
    asyncio.run(days.look())
    asyncio.run(days.look())
    assert shows == [(("study", "sources"), {"figure": ("study", "sources")})]
    assert days.results.visible and "behind" not in days.results.classes
    days.latest.state = State("another", result=("later", "sources"))
    asyncio.run(days.look())
    assert (len(shows), shows[1][0]) == (2, ("later", "sources"))
    assert "behind" in days.results.classes


def test_a_card_of_a_second_job_cancels_removes_and_goes_on_with_its_own(session, cards, asked, told, monkeypatch):
    done = []
    monkeypatch.setattr(session.jobs, "cancel", lambda number: done.append(("cancel", number)))
    monkeypatch.setattr(session.jobs, "remove", lambda number: done.append(("remove", number)))
    jobs = [
        Job(n, session.folder, "done", "campaign", "t", ("campaign",), session.folder, (f"x{n}.ledger",))
        for n in (1, 2)
    ]
    first, second = (shown(runs_jobs._Card(cards, job), job) for job in jobs)
    second._cancel()
    second._remove()
    first._remove()
    assert done == [("cancel", 2), ("remove", 2), ("remove", 1)]
    (session.folder / "x2.html").touch()
    asyncio.run(second._write_page())
    asyncio.run(first._write_page())
    assert [(order.kind, order.arguments) for order in asked.orders] == [
        ("export", commands.campaign_report(Path("x2.ledger"), Path("x2-2.html")).arguments),
        ("export", commands.campaign_report(Path("x1.ledger"), Path("x1.html")).arguments),
    ]
    assert told == []


def test_a_result_in_a_folder_is_shown_by_its_name_and_opened_with_its_job(session, cards, monkeypatch):
    opened = []
    monkeypatch.setattr(cards, "open_page", lambda *where: opened.append(where))
    (session.folder / "out").mkdir()
    for name in ("report.html", "results.nc"):
        (session.folder / "out" / name).touch()
    results = ("out/none.html", "out/results.nc", "out/report.html")
    job = Job(14, session.folder, "done", "study", "t", (), session.folder, results)
    card = shown(runs_jobs._Card(cards, job), job)
    assert texts(card.results) == [
        "Save out/results.nc",
        "Show report.html here",
        "out/report.html in a tab of its own",
    ]
    links = [each.props["href"] for each in card.results.descendants() if isinstance(each, ui.link)]
    assert links == ["/results/14/1", "/results/14/2"]
    with card.results:
        card._open_links(replace(job, number=15), 4, "sub/page.html")
    (button,) = (each for each in card.results.descendants() if getattr(each, "text", "") == "Show page.html here")
    for listener in button._event_listeners.values():
        listener.handler(SimpleNamespace())
    assert opened == [("/results/15/4", "15. sub/page.html")]


def test_answers_and_responses_are_drawn_each_in_its_own_plot(session, tab, monkeypatch):
    view = control.control_view
    for name in ("sensitivity_plot", "gain_plot", "step_plot", "sine_plot", "jitter_plot", "motion_plot"):
        monkeypatch.setattr(view, name, lambda of, name=name: (name, of))
    monkeypatch.setattr(view, "drive_plot", lambda found, curves, over="ms": ("drive_plot", curves, over))
    monkeypatch.setattr(view, "answer_words", lambda curves, what, seen: f"{what} of {curves} up to {seen}")
    monkeypatch.setattr(view, "notes", lambda found: ("one", "two"))
    page, shows = control.ControlPage(session), {}
    for name, plot in page.plots.items():
        monkeypatch.setattr(plot, "show", lambda figure, name=name: shows.update({name: figure}))
    found = SimpleNamespace(field_of_view_rad=2.5)
    page._controller(found)
    answers = SimpleNamespace(step="step", sine="sine", jitter="jitter")
    page._answers(found, answers)
    assert shows == {
        "sensitivity": ("sensitivity_plot", found),
        "gain": ("gain_plot", found),
        "step": ("step_plot", answers),
        "step_drive": ("drive_plot", "step", "ms"),
        "sine": ("sine_plot", answers),
        "sine_drive": ("drive_plot", "sine", "ms"),
        "jitter": ("jitter_plot", answers),
        "motion": ("motion_plot", answers),
        "jitter_drive": ("drive_plot", "jitter", view.SECONDS),
    }
    assert [each.text for each in (page.told_step, page.told_sine, page.told_jitter)] == [
        "Error of step up to 2.5",
        "Radial error of sine up to 2.5",
        "Radial error of jitter up to 2.5",
    ]
    assert (texts(page.notes), page.shaken.visible) == (["one", "two"], True)
    page._answers(found, SimpleNamespace(step="step", sine="sine", jitter={}))
    assert not page.shaken.visible


def test_the_budget_of_errors_is_looked_for_where_a_mission_has_one(session, tab, monkeypatch):
    begun = []
    monkeypatch.setattr(layout, "follow", lambda session, show: lambda: None)
    monkeypatch.setattr(pointing.pointing_view, "blocks", lambda view: (Soft(view.words),))
    page = pointing.PointingPage(session)
    monkeypatch.setattr(
        pointing, "background_tasks", SimpleNamespace(create_lazy=lambda task, name: begun.append(name) or task.close())
    )
    for table, words in ((None, "bare"), ("table", "with one")):
        mission = SimpleNamespace(error_budget=table)
        page.show_rest(SimpleNamespace(words=words, file=SimpleNamespace(mission=mission)))
        assert (texts(page.told), page.errors.visible) == ([words], table is not None)
    assert (page.state.text, len(begun), "behind" in page.budget.classes) == ("Computing ...", 1, True)


def test_the_rows_of_sliders_stand_in_their_groups_with_the_seldom_moved_folded(session, tab):
    tried = sliders.SliderBoard(None, None, link_view.second)
    groups = link_view.sliders(session.draft)
    tried.show(groups)
    assert [*tried.rows] == [each.key for group in groups.values() for each in group]
    assert [each.text for each in tried._box.descendants() if isinstance(each, ui.expansion)] == [
        "Communication: 6 more",
        "Beacon: 4 more",
        "Answer: 4 more",
        "Required: 1 more",
    ]
    folded = [
        row.slider.key
        for each in tried._box.descendants()
        if isinstance(each, ui.expansion)
        for row in each.descendants()
        if isinstance(row, sliders.SliderRow)
    ]
    assert folded == [key for key in tried.rows if link_view.second(key)]
    before = dict(tried.rows)
    changed = link_view.sliders(session.draft.set(LEO, "6 cm"))
    tried.show(changed)
    assert tried.rows == before and tried.rows[LEO].typed == "6 cm"
    tried.show({"Telescopes": groups["Telescopes"][:1]})
    assert [*tried.rows] == [LEO]
    assert tried.moved is None


def test_of_two_sliders_that_are_moved_the_first_of_the_board_is_asked_for(session, tab, monkeypatch):
    told = {}
    board = sliders.SliderBoard(None, None)
    board.show(link_view.sliders(session.draft))
    for key, row in board.rows.items():
        monkeypatch.setattr(row, "run_method", lambda name, new, key=key: told.setdefault(key, []).append(new))
    other = "beacon.divergence"
    board.rows[other]._begin("400 urad")
    assert board.moved == (other, "400 urad")
    board.rows[LEO]._begin("6 cm")
    assert board.moved == (LEO, "6 cm")
    board.faults({LEO: "too large", "none.such": "x"})
    board.faults({LEO: "too large", other: "odd"})
    board.faults({})
    assert told == {LEO: [{"fault": "too large"}, {"fault": ""}], other: [{"fault": "odd"}, {"fault": ""}]}
    row = board.rows[other]
    assert row._turned(float(row.slider.steps)) == row.slider.at(row.slider.steps) == row.typed
    assert told[other][-1] == {"text": row.typed}


# ---------------------------------------------------------------------------------------------- the frame and the field
def test_a_field_for_files_has_its_own_address_and_limit_until_its_page_is_closed(tab, tmp_path, monkeypatch):
    routes, heard = [], []
    monkeypatch.setattr(drop.app, "add_api_route", lambda *given, **more: routes.append((*given, more)))
    monkeypatch.setattr(drop.app, "remove_route", routes.append)
    monkeypatch.setattr(drop.ui.element, "on", lambda self, *given, **more: heard.append((*given, more["js_handler"])))
    uploads, deleted = mirror.Uploads(tmp_path / "uploads", UploadLimits(file_bytes=123_457)), []
    monkeypatch.setattr(tab, "on_delete", deleted.append)
    fields = [drop.Drop(uploads, taken, taken) for taken in (None, None)]
    urls = [url for url, _, _ in routes]
    assert len({*urls}) == 2 and all(url.startswith(f"/_nicegui/client/{tab.id}/upload/") for url in urls)
    how = {"methods": ["POST"], "include_in_schema": False}
    assert [(take, more) for _, take, more in routes] == [(field._take, how) for field in fields]
    for (event, unsent, script), field, url in zip(heard, fields, urls, strict=True):
        assert (event, unsent) == ("change", field._unsent)
        assert f'fetch("{url}", ' in script and "file.size > 123457)" in script
        assert "URL" not in script and "MOST" not in script
    routes.clear()
    for each in reversed(deleted):
        each()
    assert routes == urls[::-1]


@pytest.mark.parametrize(
    ("changed", "disk", "faults", "words"),
    [
        (False, "", 0, "saved"),
        (True, "", 0, "not saved"),
        (False, "gone", 1, "not saved, 1 fault to correct, gone from disk"),
        (False, "changed", 2, "2 faults to correct, changed on disk; open it again"),
        (True, "changed", 0, "not saved, changed on disk; open it again"),
        (False, "", 3, "saved, 3 faults to correct"),
    ],
)
def test_the_head_of_a_page_says_what_is_saved_and_what_is_wrong(changed, disk, faults, words):
    assert layout._words(SimpleNamespace(changed=changed, problems=("fault",) * faults), disk) == words


@pytest.mark.parametrize(("error", "words"), [(JobError("no job"), "no job"), (OSError("full"), "full")])
def test_what_is_refused_is_told_and_not_done(told, error, words):
    done = []

    def refuse():
        raise error

    assert layout.attempt(lambda: done.append(1)) and (done, told) == ([1], [])
    assert not layout.attempt(refuse) and told == [words]
    with pytest.raises(KeyError):
        layout.attempt(lambda: {}["none"])


@pytest.mark.parametrize(
    ("refused", "python", "said"),
    [
        ("", False, ("Copied: microrad budget 'a b.toml'", "positive")),
        ("", True, ("Copied: from microrad.link.study import run_link_study ...", "positive")),
        ("denied", False, ("Not copied, denied: microrad budget 'a b.toml'", "negative")),
    ],
)
def test_what_was_copied_is_told_by_its_first_line_and_what_was_not_as_a_whole(monkeypatch, refused, python, said):
    asked, told = [], []

    async def run(script, timeout):
        asked.append((script, timeout))
        return refused

    monkeypatch.setattr(layout.ui, "run_javascript", run)
    monkeypatch.setattr(layout.ui, "notify", lambda words, type, **how: told.append((words, type)))
    asyncio.run(layout._copy(None, python))
    action = commands.budget(Path("a b.toml"))
    asyncio.run(layout._copy(action, python))
    text = action.python if python else action.command
    ((script, timeout),) = asked
    assert (told, timeout) == ([said], layout.COPY_S) and f"writeText({json.dumps(text)})" in script


def test_a_page_follows_the_session_and_does_not_show_what_it_has_changed_itself(tab, monkeypatch):
    timers, shown = [], []
    state = SimpleNamespace(revision=3, disk="")
    monkeypatch.setattr(layout.ui, "timer", lambda every_s, look: timers.append((every_s, look)))
    mark = layout.follow(state, lambda: shown.append(state.revision))
    ((every_s, look),) = timers
    assert (every_s, shown) == (layout.POLL_S, [3])
    for state.revision, own in ((3, False), (5, False), (6, True), (4, False)):
        if own:
            mark()
        look()
    assert shown == [3, 5, 4]


@pytest.fixture
def naming(session):
    """A session whose mission names a mirror file and a spectrum."""
    begin, end = TEXT.index("[mirror]\n"), TEXT.index("[amplifier]\n")
    own = TEXT[begin:end].removeprefix("[mirror]\n").replace("[mirror.", "[")
    text = f'{TEXT[:begin]}[mirror]\nfile = "mirror.toml"\n\n{TEXT[end:]}'
    text = text.replace('spectrum = "olympus"', 'spectrum = "table"\nfile = "shake.csv"', 1)
    (session.folder / "mirror.toml").write_text(own, "utf-8")
    (session.folder / "shake.csv").write_text("Hz, urad^2/Hz\n0.1, 100\n1000, 0.1\n", "utf-8")
    session.change(session.draft.with_text(text))
    return session


def rewrite(path, old, new):
    path.write_text(path.read_text("utf-8").replace(old, new, 1), "utf-8")


def test_a_file_that_the_mission_names_and_another_program_changes_is_read_anew(naming):
    key, revision = naming.key, naming.revision
    assert (naming.mission().mirror_file.path.name, naming.disk, naming.key) == ("mirror.toml", "", key)
    rewrite(naming.folder / "shake.csv", "0.1, 100", "0.1, 1000")
    assert (naming.disk, naming.revision) == ("", revision + 1)  # so that every page follows
    shaken = naming.key
    rewrite(naming.folder / "mirror.toml", "name = ", "# another mirror\nname = ")
    turned = naming.key
    assert naming.mission().mirror_file.text == (naming.folder / "mirror.toml").read_text("utf-8")
    held = (naming.folder / "mirror.toml").read_bytes()
    (naming.folder / "mirror.toml").unlink()
    lost = naming.key
    assert naming.mission() is None and "mirror.toml" in naming.faults()
    (naming.folder / "mirror.toml").write_bytes(held)
    assert len({key, shaken, turned, lost, naming.key}) == 5 and naming.mission() is not None
    revision = naming.revision
    naming.set(LEO, "6 cm")
    assert (naming.inputs, naming.revision) == (naming.inputs, revision + 1)
    naming.change(naming.draft.with_text(naming.draft.text.replace("shake.csv", "\\u0000")))
    assert None in naming.inputs


def test_each_page_asks_anew_once_a_file_that_the_mission_names_is_another(naming, days, links, controls, monkeypatch):
    now, seen = [100.0], []
    monkeypatch.setattr(link, "time", SimpleNamespace(monotonic=lambda: now[0]))
    page = Board(naming, link_view.sliders, lambda file: seen.append(file.mirror_file.text) or file)

    def look():
        days.reload()
        links._ask_study()
        now[0] += 2.0 * link._REST_S
        links._ask_study()
        for each in (controls.reload, controls.reload, page._reload, page._reload):
            asyncio.run(each())

    look()
    rewrite(naming.folder / "mirror.toml", "name = ", "# another mirror\nname = ")
    look()
    rewrite(naming.folder / "shake.csv", "0.1, 100", "0.1, 1000")
    days._show_progress(State(days.asked[-1], result=(1,)))
    assert days.state.text == "The day of the mission before this."
    look()
    days._show_progress(State(days.asked[-1], result=(1,)))
    assert days.state.text == "The day of the mission as it stands."
    assert days.asked == links.asked and len(set(days.asked)) == 3
    assert (controls.made, len(seen), len(page.shows)) == (["PI"] * 3, 3, 3)
    assert ["# another mirror" in text for text in seen] == [False, True, True]


# -------------------------------------------------------------------------------------------- what pages are built of
OUTLINES = {
    "compare": """
div.compare-choice
  select.compare-select[label=Compare with|dense|outlined] of other.toml, the shipped mission, a: one, b: another
  div.studio-copy
  div.soft for the other:
  div.studio-copy
div.no.kept[role=alert]
div
timer 0
timer 0.5
""",
    "day": """
div.studio-copy
div.items-center
  div[role=status]
  q-linear-progress.day-bar[aria-label=Progress]<max-width: 20rem>
  q-btn[dense|outline|no-caps] Cancel
  q-btn[dense|outline|no-caps] Compute
div.faults.kept.hidden[role=alert]
div.hidden
  div.soft A study of a whole mission takes the pointing loss that its loop leaves in place of this one.
  div
timer 0.5
timer 0.25
""",
    "runs": """
div.runs-start
  section.runs-card[aria-label=Study]
    h2 Study of the mission
    div.soft Everything that follows from leo-geo.toml: verdict, figures, report.
    input.runs-name[label=Folder for the results|dense|outlined]
    div.runs-go
      q-btn[no-caps] Run the study
      div.studio-copy
    div.no.kept[role=alert]
  timer 0.5
  timer 0
  section.runs-card[aria-label=Campaign]
    h2 Campaign
    div.soft Many runs of a mission with drawn inputs: tails, sweeps, sensitivity.
    select.runs-name[label=Campaign file|dense|outlined]
    input.runs-name[label=Ledger|dense|outlined]
    div.runs-go
      q-btn[no-caps] Run the campaign
      q-btn[outline|no-caps] Write an example
      div.studio-copy
    div.no.kept[role=alert]
  timer 0
  timer 4
h2 Jobs
div.soft They run in processes of their own, one after the other, and go on when this page is closed.
div.soft Nothing was run in this folder yet.
div.runs-list
timer 0.5
section.runs-viewer[aria-label=Report]
""",
    "link": """
div.studio-copy
div.beside
  div.slider-column
    div.sliders
  div
    div.faults.kept.hidden[role=alert]
    h2 Margins
    margin_cards
    h2 Margin map
    figure.margin-map[aria-label=Link margin over data rate and pointing error; in words below]
    div.soft
    div[role=status]
    h2 Budgets
    q-btn-toggle[aria-label=Budget shown|dense|no-caps]
    table.wide-table[dense|flat|tabindex=0|row-key=id|wrap-cells|hide-bottom] of
    h2 What follows
    div.soft[role=status]
    div
timer 0.5
timer 0.25
""",
    "pointing": """
div.studio-copy
div.beside
  div.slider-column
    div.sliders
  div
    div.faults.kept.hidden[role=alert]
    h2 What the beacon covers
    figure[aria-label=Probability that the pointing error is below an angle; totals in the table below]
    h2 Lines and totals
    figure[aria-label=Half widths of the lines and totals of the rules; in numbers in the tables below]
    div
    div.hidden
      h2 Pointing error budget
      div.soft[role=status]
      div
timer 0.5
""",
    "control": """
div.studio-copy
div.no.kept[role=alert]
h2 Controllers of the mission
div.soft Each is tuned for the least residual under the modulus margin of the mission.
div.items-center
  q-btn[dense|outline|no-caps] Tune all
  q-btn.hidden[dense|flat|no-caps] Stop
div
h2 One controller
div.control-asked
  select[label=Controller|dense|outlined|options-dense]
  input[label=Step|dense|outlined|debounce=500] = 100 urad
  input[label=Sine, amplitude|dense|outlined|debounce=500] = 300 urad
  input[label=Sine, frequency|dense|outlined|debounce=500] = 15 Hz
  q-btn-toggle[aria-label=Hysteresis of the mirror|dense|no-caps] = both of both, with hysteresis, without
div.soft[role=status]
div.no.kept[role=alert]
div.gap-0
h3 By frequency
div.plots
  figure[aria-label=Sensitivity by frequency]
  figure[aria-label=Loop gain by frequency]
h3 A step of the reference on axis x
div[role=status]
div.plots
  figure[aria-label=Step response]
  figure[aria-label=Drive behind a step]
h3 A sine of the reference on axis x
div[role=status]
div.plots
  figure[aria-label=Error while a sine is followed]
  figure[aria-label=Drive while a sine is followed]
div
  h3 Everything that disturbs the loop
  div[role=status]
  div.plots
    figure[aria-label=Error under disturbance]
    figure[aria-label=What is to be followed and what the mirror does]
    figure[aria-label=Drive under disturbance]
timer 0.5
""",
    "mirror": """
div.studio-copy
div.mirror-page
  div.mirror-form
    h2 Recordings
    input.drop-zone[aria-label=Recordings: drop files here, or choose them|multiple|type=file]
    div.soft.small Drop files on the field: CSV, text, LVM, TDMS, MAT, NPY, NPZ or HDF5; up to 200 MB each.
    div.no.kept[role=alert]
    div.gap-1
    h2 Channels
    select[label=Drive|dense|outlined|options-dense]
    select[label=Angle or displacement|dense|outlined|options-dense]
    div.pair
      select[label=Unit of the drive|dense|outlined|options-dense] of V, mV
      select[label=Unit of the output|dense|outlined|options-dense] of mrad, µrad, rad, µm, mm, m
      input[label=Sample rate|hint=empty: as in the file|dense|outlined|debounce=400]
      input[label=Lever arm|hint=50 mm; for a displacement|dense|outlined|debounce=400]
    select[multiple|label=Go on in spite of|dense|outlined|clearable|use-chips|options-dense] of jitter, clipping, \
dead, quantisation, drift, unexcited, lead
    h2 Identification
    input[label=Name of the mirror|hint=its file has this name and .toml|dense|outlined|debounce=400]
    q-checkbox Hysteresis alone: two models, in seconds = False
    q-checkbox No model that moves the wrong way = False
    div.no.kept[role=alert]
    q-btn[no-caps] Identify
  div.mirror-seen
    h2 Measured
    div[role=status]
    div.gap-1
    div.plots
      figure[aria-label=Measured loop: output over drive]
      figure[aria-label=Drive and output over time]
    h2 Identification
    select.hidden[label=Identification|dense|outlined|options-dense]
    div.kept[role=status] Nothing was identified yet.
    q-linear-progress.hidden[aria-label=Progress of the identification]
    q-btn.self-start.hidden[dense|outline|no-caps] Cancel
    div.hidden
      div
        select[label=Model shown|dense|outlined|options-dense]<min-width: 14rem> = -1 of best so far
        select[label=Recording shown|dense|outlined|options-dense]<min-width: 14rem> of
      div.plots
        figure[aria-label=Measured loop and that of the model]
        figure[aria-label=Residual over time]
      div.soft.small Residuals in per cent of the peak-to-peak output.
      table.wide-table[dense|flat|tabindex=0|row-key=id|wrap-cells|hide-bottom] of Model, >Held out (rms), >Fitted \
(rms), Note
    div.gap-1
    div
    timer 0.5
timer 0.5
timer 0.5
""",
}


@pytest.mark.parametrize("name", OUTLINES)
def test_a_page_is_built_of_its_parts_in_their_order_each_with_its_name(session, tab, monkeypatch, name):
    (session.folder / "other.toml").write_text(TEXT, "utf-8")
    found = [SimpleNamespace(name="a", title="one"), SimpleNamespace(name="b", title="another")]
    monkeypatch.setattr(compare.presets, "presets", lambda: found)
    modules = {each.__name__.rpartition(".")[2]: each for each in (compare, control, day, link, mirror, pointing, runs)}
    modules[name].page(session)
    assert [line.rstrip() for line in outline(tab.content)] == OUTLINES[name].strip().splitlines()


def card_of(state, number=1, kind="study", title="mine", results=(), beside=Others(), **more):  # noqa: B008
    """Builds the card of a job, with what it has beside it."""

    def build(session):
        for name in results:
            (session.folder / name).touch()
        job = Job(number, session.folder, state, kind, title, ("run", "a b"), session.folder, results, **more)
        return shown(runs_jobs._Card(runs_jobs.JobList(session, lambda *_: None), job), job, beside).element

    return build


def a_viewer(session):
    viewer = runs._Viewer()
    viewer.build()
    viewer.show("/results/3/1", "3. page.html")
    return viewer.place


def a_panel(session):
    panel = runs_jobs.CampaignPanel(session, session.folder / "x.ledger")
    panel.open = True
    plots = {"A": empty("a"), "B": empty("b")}
    panel._show(Figures("Of 7 rows so far", "The limit is met.", [Soft("soft words")], plots))
    return panel.place


def an_identification(session):
    view = mirror_job.JobView(session)
    view.chosen = "play"
    view._end(Job(4, session.folder, "done", "identification", results=("stage.toml", "stage.html")))
    return view.end


def recordings(session):
    page = mirror.MirrorPage(session)
    page.form = replace(page.form, seen="b")
    page.listings = dict.fromkeys("bc", "it has no channel 3")
    uses = zip(("a&b.csv", "b.csv", "c.csv"), ("fit", "check", "leave"), strict=True)
    page._rows(tuple(mirror_form.Dropped(name[0], name, Path(), use) for name, use in uses))
    return page.list


def all_blocks(session):
    rows = ((Cell("2 dB", "PASS"), "x"), (Cell("3 dB", "FAIL"), "sum"))
    inner = (View("Inner", ["within"]), Table("a table", ("margin", "of\nwhat"), rows, words={1}, totals=1))
    blocks = [
        *("plain words", Soft("how to read it"), Verbatim("x = 1"), Verdict("it is missed", [], False)),
        *(Verdict("it is met", [Points(["first", "second"])], True), Verdict("it is open"), View("Outer", inner)),
        *(View("Folded away", ["hidden"], folded=True), Drawing("map", "The world", "Of one day", "<svg/>")),
    ]
    elements.Blocks().show_blocks(blocks, {"map": "data:image/png;base64,AA"})
    return ui.context.client.content


TIMES = {"started": "2026-03-20T12:00:00Z", "ended": "2026-03-20T12:01:30Z"}
REPORT = Others(True, True, Job(6, Path(), "done", "export", results=("x.html",)))
BUILT = {
    "a card that waits": card_of("queued", title="<b>mine</b>", queued="2026-03-20T12:00:07Z"),
    "a card that runs": card_of("running", 2, "campaign", "wide", progress=Progress(3, 8, "rows"), **TIMES),
    "a card that is done": card_of("done", 3, results=("r.nc", "r.html"), code=1, **TIMES),
    "a card that failed": card_of("failed", 4, "export", words="no room", code=2),
    "a card of a campaign": card_of("lost", 5, "campaign", "wide", ("x.ledger",), beside=REPORT, words="it is gone"),
    **{each.__name__: each for each in (a_viewer, a_panel, an_identification, recordings, all_blocks)},
}
SEEN = {
    "a card that waits": """
div.runs-head
  h3 1. <b>mine</b>
  div.runs-state.soft[role=status] waiting for the job before it
  q-btn[dense|outline|no-caps] Cancel
div.small.soft put in the queue 2026-03-20 12:00:07 UTC
div.runs-results
  div.runs-results
  div.runs-results
div
code.mono.runs-command microrad run 'a b'
""",
    "a card that runs": """
div.runs-head
  h3 2. wide
  div.runs-state.soft[role=status] running
  q-btn[dense|outline|no-caps] Cancel
q-linear-progress[aria-label=Progress of job 2|instant-feedback] = 0.375
div.small 38 %, 3 of 8 rows
div.small.soft started 2026-03-20 12:00:00 UTC, 90 s
div.runs-results
  div.runs-results
div
code.mono.runs-command microrad run 'a b'
""",
    "a card that is done": """
div.runs-head
  h3 3. mine
  div.runs-state.no[role=status] done: not every requirement is met
  q-btn[dense|flat|no-caps] Remove from the list
div.small.soft started 2026-03-20 12:00:00 UTC, 90 s
div.runs-results
  div.runs-results
  div.runs-results
    link[href=/results/3/0] Save r.nc
    q-btn[dense|no-caps] Show r.html here
    link[href=/results/3/1|target=_blank] r.html in a tab of its own
div
details.runs-details[open]
  summary What it printed
  pre.runs-said[tabindex=0] said
code.mono.runs-command microrad run 'a b'
""",
    "a card that failed": """
div.runs-head
  h3 4. mine
  div.runs-state.no[role=status] failed
  q-btn[dense|flat|no-caps] Remove from the list
div.small.soft
div.no.kept no room
div.runs-results
  div.runs-results
  div.runs-results
div
code.mono.runs-command microrad run 'a b'
""",
    "a card of a campaign": """
div.runs-head
  h3 5. wide
  div.runs-state.no[role=status] lost
  q-btn[dense|outline|no-caps] Go on
  q-btn[dense|outline|no-caps] Hide its figures
  q-btn[dense|flat|no-caps] Remove from the list
div.small.soft
div.no.kept it is gone
div.runs-results
  div.runs-results
    q-btn[dense|no-caps] Show x.html here
    link[href=/results/6/0|target=_blank] x.html in a tab of its own
  div.runs-results
    link[href=/results/5/0] Save x.ledger
div
  section.runs-figures[aria-label=Figures of the campaign]
    div.runs-rows Reading the ledger ...
  timer 1
code.mono.runs-command microrad run 'a b'
""",
    "a_viewer": """
div.runs-head
  h2 3. page.html
  q-btn[dense|outline|no-caps] Close the report
iframe.runs-frame[title=3. page.html|src=/results/3/1]
""",
    "a_panel": """
div.runs-rows Of 7 rows so far
div.kept The limit is met.
div.runs-plot
  select[label=Shown|dense|outlined] = A of A, B
  figure[aria-label=Distribution over the rows: A]
div
  div.soft soft words
""",
    "an_identification": """
div.items-center
  q-btn[no-caps] Use this mirror in the mission
  link[href=/results/4/1|target=_blank] Open the report
  link[href=/results/4/0|target=_blank] Mirror file stage.toml
""",
    "recordings": """
div.mirror-file
  div.name a&b.csv
  q-tooltip a&b.csv
  select[aria-label=Use of a b.csv|dense|outlined|options-dense] = fit of fit, check only, leave out
  q-btn[dense|flat|no-caps] Show
  q-btn[dense|flat|no-caps] Remove
div.mirror-file
  div.name.seen b.csv
  q-tooltip b.csv
  select[aria-label=Use of b.csv|dense|outlined|options-dense] = check of fit, check only, leave out
  q-btn[dense|flat|no-caps] Show
  q-btn[dense|flat|no-caps] Remove
div.no.kept.small it has no channel 3
div.mirror-file
  div.name c.csv
  q-tooltip c.csv
  select[aria-label=Use of c.csv|dense|outlined|options-dense] = leave of fit, check only, leave out
  q-btn[dense|flat|no-caps] Show
  q-btn[dense|flat|no-caps] Remove
""",
    "all_blocks": """
div
  div plain words
  div.soft how to read it
  div.kept.mono x = 1
  div.FAIL.kept it is missed
  div.PASS.kept it is met
  ul.points
    li first
    li second
  div it is open
  h2 Outer
  h3 Inner
  div within
  h3 a table
  table.wide-table[dense|flat|tabindex=0|row-key=id|wrap-cells|hide-bottom] of >Margin, Of what
  | 2 dB PASS PASS | x
  | == | 3 dB FAIL FAIL | sum
  expansion[label=Folded away|dense] Folded away = False
    div hidden
  img.picture[src=data:image/png;base64,AA|alt=The world]
  div.soft.small The world. Of one day
""",
}


@pytest.mark.parametrize("name", BUILT)
def test_a_part_of_a_page_is_built_of_what_is_to_be_seen(session, tab, monkeypatch, name):
    scripts = []
    monkeypatch.setattr(runs.ui, "run_javascript", scripts.append)
    monkeypatch.setattr(session.jobs, "output", lambda number: " said\n" if number == 3 else "")
    assert [each.rstrip() for each in outline(BUILT[name](session), seen=True)] == SEEN[name].strip().splitlines()
    scroll = "document.querySelector('.runs-viewer').scrollIntoView({behavior: 'smooth'})"
    assert scripts == ([scroll] if name == "a_viewer" else [])


CALLED = {
    runs._Study: {"_run": "Run the study"},
    runs._Campaign: {"_run": "Run the campaign", "_example": "Write an example"},
    runs_jobs._Card: {
        "_cancel": "Cancel",
        "_go_on": "Go on",
        "_toggle": "Show its figures",
        "_write_page": "Write its report",
        "_remove": "Remove from the list",
    },
    mirror.MirrorPage: {"start": "Identify"},
    mirror_job.JobView: {"stop": "Cancel"},
    control.ControlPage: {"tune_all": "Tune all", "stop_all": "Stop"},
    day.DayPage: {"reload": "Compute"},
}


@pytest.mark.parametrize("of", CALLED, ids=lambda of: of.__name__)
def test_each_button_does_what_it_says(session, tab, monkeypatch, of):
    called = []
    for name in CALLED[of]:
        monkeypatch.setattr(of, name, lambda self, name=name: called.append(name))
    job = Job(1, session.folder, "done", "campaign", "t", (), session.folder)
    of(*((runs_jobs.JobList(session, print), job) if of is runs_jobs._Card else (session,)))
    called.clear()
    found = buttons(tab.content)
    for said in CALLED[of].values():
        press(found[said])
    assert called == [*CALLED[of]]


def test_a_recording_is_shown_and_removed_by_the_buttons_of_its_row(bench, monkeypatch):
    called = []
    for name in ("see", "remove"):
        monkeypatch.setattr(bench, name, lambda key, name=name: called.append((name, key)))
    bench._rows(tuple(mirror_form.Dropped(name[0], name, Path(), "fit") for name in ("a.csv", "b.csv")))
    for each in [each for each in bench.list.descendants() if isinstance(each, ui.button)]:
        press(each)
    assert called == [("see", "a"), ("remove", "a"), ("see", "b"), ("remove", "b")]
    monkeypatch.setattr(bench, "use", lambda key, use: called.append((key, use)))
    [first, second] = [each for each in bench.list.descendants() if isinstance(each, ui.select)]
    second.value, first.value = "leave", "check"
    assert called[4:] == [("b", "leave"), ("a", "check")]


def test_the_day_that_is_computed_is_cancelled_by_its_button(session, tab):
    page = day.DayPage(session)
    page.latest._state = State("k", running=True)
    press(buttons(tab.content)["Cancel"])
    assert page.latest.state == State()


def test_a_report_is_closed_and_a_mirror_taken_by_their_buttons(session, tab, monkeypatch):
    used, viewer = [], runs._Viewer()
    monkeypatch.setattr(runs.ui, "run_javascript", used.append)
    monkeypatch.setattr(mirror_job.JobView, "use", lambda self, mirror: used.append(mirror))
    viewer.build()
    viewer.show("/results/3/1", "a page")
    viewer.show("/results/4/0", "another page")
    assert texts(viewer.place) == ["another page", "Close the report"]
    press(buttons(viewer.place)["Close the report"])
    assert texts(viewer.place) == []
    press(buttons(an_identification(session))["Use this mirror in the mission"])
    assert used[2:] == [session.folder / "stage.toml"]


@pytest.mark.parametrize("python", [False, True])
def test_a_command_and_its_python_are_copied_each_by_its_own_button(tab, monkeypatch, python):
    copied = []
    monkeypatch.setattr(layout, "_copy", lambda action, python: copied.append((action, python)))
    action = commands.Action(("a",), "b")
    layout.copy_buttons(lambda: action)
    press(buttons(tab.content)["Copy as Python" if python else "Copy as command"])
    assert copied == [(action, python)]


COPIED = {compare: 4, control: 2, day: 2, link: 2, pointing: 2}


@pytest.mark.parametrize("module", COPIED, ids=lambda module: module.TITLE)
def test_each_page_copies_what_it_shows(session, tab, monkeypatch, module):
    copied = []
    monkeypatch.setattr(layout, "_copy", lambda action, python: copied.append(action))
    session.other = Draft.open(session.draft.path)
    module.page(session)
    for each in [each for each in tab.content.descendants() if getattr(each, "text", "").startswith("Copy as")]:
        press(each)
    of = {control: commands.design, day: commands.contacts}.get(module, commands.budget)
    assert copied == [of(Path("leo-geo.toml"))] * COPIED[module]


# ------------------------------------------------------------------------------------------- values that are not alike
def test_the_sine_that_is_asked_for_at_first_is_the_last_of_the_scenario(session, controls):
    session.set("scenario.amplitude", "123.25 urad")
    session.set("scenario.pid_frequencies", "2 Hz, 3.5 Hz, 9.25 Hz")
    asyncio.run(controls.reload())
    assert (controls.step.value, controls.amplitude.value, controls.frequency.value) == (
        *("100 urad", "123.25 urad", "9.25 Hz"),
    )
    ask, _ = controls.drawn[1]
    assert (ask.step_rad, ask.sine_rad, ask.sine_hz) == pytest.approx((1e-4, 123.25e-6, 9.25))


@pytest.mark.parametrize(
    ("names", "first"),
    [(("a",), "a"), (("a", "b", "c"), "a"), (("a", "b", "c", "d"), "b"), (("a", "b", "c", "d", "e"), "b")],
)
def test_the_second_of_more_than_three_controllers_is_shown_at_first(controls, monkeypatch, names, first):
    monkeypatch.setattr(control, "_names", lambda table: names)
    asyncio.run(controls.reload())
    assert (controls.name.value, controls.made, [*controls.found]) == (first, [first], [*names])


@pytest.fixture
def inner(session):
    """The session with its mission in a folder within the working folder, saved."""
    (session.folder / "sub").mkdir()
    path = session.folder / "sub" / "m n.toml"
    path.write_text(TEXT, "utf-8")
    session.replace(Draft.open(path))
    return session


@pytest.mark.parametrize("module", [control, day, link, pointing, compare], ids=lambda module: module.TITLE)
def test_a_mission_in_an_inner_folder_is_copied_by_its_way_from_the_working_folder(inner, tab, monkeypatch, module):
    copied = []
    monkeypatch.setattr(layout, "_copy", lambda action, python: copied.append(action.arguments[1:]))
    module.page(inner)
    press(next(each for each in tab.content.descendants() if getattr(each, "text", "") == "Copy as command"))
    assert copied == [("sub/m n.toml",)]


def test_a_mission_in_an_inner_folder_is_run_by_its_way_and_named_by_its_own_name(inner, tab, asked):
    study = runs._Study(inner)
    assert study.about.text == "Everything that follows from sub/m n.toml: verdict, figures, report."
    asyncio.run(study._name())
    assert study.folder.value == "m n-study"
    asyncio.run(study._run())
    assert asked.orders[0].arguments == ("run", "sub/m n.toml", "--output", "m n-study")
    assert asked.orders[0].results[0] == "m n-study/report.html"
    campaign = runs._Campaign(inner)
    asyncio.run(campaign._example())
    assert 'mission = "sub/m n.toml"' in (inner.folder / "campaign.toml").read_text("utf-8")
    inner.draft.path.unlink()
    assert inner.disk_words() == "sub/m n.toml is not on disk any more; save it again"
    assert compare._Page(inner)._name(inner.draft) == "sub/m n.toml (saved)"


@pytest.mark.parametrize(
    ("changed", "disk", "can"),
    [(False, "", False), (True, "", True), (False, "changed", False), (True, "changed", True), (False, "gone", True)],
)
def test_the_button_of_the_frame_saves_where_there_is_something_to_save(session, tab, changed, disk, can):
    if changed:
        session.set(LEO, "6 cm")
    if disk == "changed":
        session.draft.path.write_text(TEXT.replace('"5 cm"', '"8 cm"'), "utf-8")
    elif disk:
        session.draft.path.unlink()
    with ui.row() as place:
        layout._state(session)
    assert buttons(place)["Save"].enabled is can


@pytest.mark.parametrize(
    ("seen", "files", "asked_for"),
    [("", "", None), ("a", "a", None), ("", "ab", "b"), ("gone", "ab", "b"), ("gone", "", ""), ("b", "ab", None)],
)
def test_the_newest_recording_is_shown_where_none_or_one_that_is_gone_was(bench, monkeypatch, seen, files, asked_for):
    called = []

    async def see(key):
        called.append(key)

    async def measured():
        called.append("measured")

    monkeypatch.setattr(bench, "see", see)
    monkeypatch.setattr(bench, "_measured", measured)
    put_in(bench, *(f"{name}.csv" for name in files))
    bench.form, bench.kept = replace(bench.form, seen=seen), False
    asyncio.run(bench.look())
    assert called == [*([] if asked_for is None else [asked_for]), "measured"]


@pytest.mark.parametrize(
    ("chosen", "left", "shown"), [(2, 3, 2), (2, 1, 0), (2, 2, 1), (2, 0, -1), (-1, 1, -1), (0, 1, 0), (1, 1, 0)]
)
def test_a_model_that_was_chosen_is_the_last_where_there_are_fewer(session, job_view, chosen, left, shown):
    view = job_view
    view.jobs = [identified(session.folder, 2), identified(session.folder, 1)]
    view.read = {"2": fits("a", "b", "c"), "1": fits("d", "e", "f")[:left]}
    asyncio.run(view.look())
    view.model.value = chosen
    asyncio.run(view.choose(SimpleNamespace(value=1)))
    assert (view.model.value, view.model.options) == (shown, {-1: "best so far", **dict(enumerate("def"[:left]))})
    assert view.live.visible is (left > 0)


@pytest.mark.parametrize(
    ("asked", "shows"),
    [
        ([], []),
        (["sensitivity"], ["sensitivity", "notes", "told"]),
        (["gain", "step"], ["gain", "step", "notes", "told"]),
        (["sine", "jitter_drive"], ["sine", "jitter_drive", "told"]),
    ],
)
def test_grey_is_what_answers_another_question_and_nothing_else(controls, asked, shows):
    controls._dim([*controls.plots])
    controls._dim(asked)
    told = [controls.told_step, controls.told_sine, controls.told_jitter]
    grey = {name for name, plot in controls.plots.items() if "behind" in plot.classes}
    grey |= {"notes"} if "behind" in controls.notes.classes else set()
    grey |= {"told"} if all("behind" in each.classes for each in told) else set()
    assert grey == set(shows)
    assert len({"behind" in each.classes for each in told}) == 1


@pytest.mark.parametrize(
    ("value", "told"),
    [("a b-1_2.csv", "a b-1_2.csv"), ('x"y', "x y"), ("µ'<>&é", "µ    é"), ("", ""), ("a\nb\tc", "a b c")],
)
def test_a_name_within_a_property_keeps_letters_and_what_cannot_end_it(value, told):
    assert mirror._attribute(value) == told


@pytest.mark.parametrize(
    ("code", "state", "look"), [(1, "done", "no"), (0, "done", "yes"), (None, "done", "yes"), (1, "cancelled", "soft")]
)
def test_a_state_that_changes_changes_its_colour(session, cards, code, state, look):
    job = Job(2, session.folder, "queued", "study", "mine")
    card = shown(runs_jobs._Card(cards, job), job)
    assert "soft" in card.state.classes
    shown(card, replace(job, state="failed"))
    shown(card, replace(job, state=state, code=code))
    assert [name for name in ("yes", "no", "soft") if name in card.state.classes] == [look]


def test_a_table_shows_all_its_rows_and_tells_its_sums_by_a_class(tab):
    made = elements.table(("a", "b"), numbers=(1,))
    assert made.props[":pagination"] == "{rowsPerPage: 0}"
    assert made.props[":table-row-class-fn"] == "row => row.total ? 'total' : ''"
    assert [column[":classes"] for column in made.columns] == [
        "row => ` ${row.mark0 ?? ''}`",
        "row => `text-no-wrap ${row.mark1 ?? ''}`",
    ]
    assert [(column["name"], column["field"], column["align"]) for column in made.columns] == [
        *(("c0", "c0", "left"), ("c1", "c1", "right")),
    ]


def test_each_class_of_the_style_is_one_of_the_pages():
    folder = Path(layout.__file__).parent
    style = re.sub(r"/\*.*?\*/", "", (folder / "style.css").read_text("utf-8"), flags=re.DOTALL)
    styled = set(re.findall(r"\.([A-Za-z][\w-]*)", " ".join(re.findall(r"([^{}]+)\{", style))))
    source = " ".join(path.read_text("utf-8") for path in (*folder.glob("*.py"), *folder.glob("*.js")))
    own = {name for name in styled if not name.startswith(("q-", "nicegui-", "text-"))} - {"PASS", "FAIL"}
    assert [name for name in sorted(own) if not re.search(rf"(?<![\w-]){name}(?![\w-])", source)] == []
    given = set(" ".join(re.findall(r'classes\((?:add=)?"([^"]+)"', source)).split())
    of_others = ["gap-0", "gap-1", "items-center", "js-plotly-plot", "self-start", "w-full", "day-bar", "margin-map"]
    assert sorted(given - styled - set(of_others)) == []
    for name in ("PASS", "FAIL", "behind", "no", "yes", "soft"):
        assert f".{name}" in style


def test_a_mirror_that_is_taken_is_told_as_good_news(session, job_view, monkeypatch):
    said = []
    monkeypatch.setattr(mirror_job.ui, "notify", lambda words, **settings: said.append((words, settings)))
    job_view.use(session.folder / "sub" / "stage 2.toml")
    words = "[mirror] of the mission names stage 2.toml now; save the mission to keep it."
    assert said == [(words, {"type": "positive"})]
    assert 'file = "sub/stage 2.toml"' in session.draft.text


# -------------------------------------------------------------------------------------------------- what a slider tells
SLIDERS = {
    "terminals.leo_aperture": ("5 cm", "try_text", "6 cm", ("try", "6 cm")),
    "terminals.geo_aperture": ("15 cm", "set_text", "17 cm", ("set", "17 cm")),
    "beacon.divergence": ("780 urad", "try_place", 240, ("try", "5000 urad")),
    "answer.transmit_power": ("0.1 W", "set_place", 0, ("set", "0.02 W")),
}


def slider_of(session, key):
    return next(each for group in link_view.sliders(session.draft).values() for each in group if each.key == key)


def heard_by(row):
    """What a row does at each event."""
    return {each.type: each.handler for each in row._event_listeners.values()}


@pytest.mark.parametrize("key", SLIDERS)
def test_a_slider_tells_what_is_tried_and_what_is_let_go(session, tab, key):
    typed, event, given, told = SLIDERS[key]
    session.set(key, typed)
    slider, said = slider_of(session, key), []

    async def tried(key, text):
        said.append(("try", key, text))

    async def let_go(key, text):
        said.append(("set", key, text))

    row = sliders.SliderRow(slider, tried, let_go)
    begin = {"fault": "", "text": typed, "place": slider.position, "steps": 240}
    assert (row.props["label"], row.props["begin"]) == (slider.label, begin)
    heard = heard_by(row)
    assert [*heard] == ["try_text", "set_text", "try_place", "set_place"]
    asyncio.run(heard[event](SimpleNamespace(args=given)))
    assert said == [(told[0], key, told[1])]
    assert (row.typed, row.busy) == (told[1], told[0] == "try")


BOARD = """
h2
  div Answer
slider[label=Transmit power]
slider[label=Divergence]
slider[label=Pointing error]
slider[label=Distance]
slider[label=Required power]
expansion[label=Answer: 4 more|dense] Answer: 4 more = False
  slider[label=Wavelength]
  slider[label=Strehl]
  slider[label=Transmit optics loss]
  slider[label=Receive optics loss]
h2
  div Required
slider[label=Margin]
slider[label=Pointing error]
expansion[label=Required: 1 more|dense] Required: 1 more = False
  slider[label=Outage]
"""


def test_the_sliders_that_are_seldom_moved_stand_folded_below_their_group(session, tab):
    groups, board = link_view.sliders(session.draft), sliders.SliderBoard(print, print, link_view.second)
    board.show({name: groups[name] for name in ("Answer", "Required")})
    assert outline(board._box) == BOARD.strip().splitlines()


@pytest.mark.parametrize("late", [False, True])
def test_a_browser_has_five_seconds_to_draw(tab, monkeypatch, late):
    figure, asked = elements.Figure("of what"), []

    async def drawn(name, *args, timeout):
        asked.append((name, args, timeout))
        if late:
            raise TimeoutError

    monkeypatch.setattr(figure, "run_method", drawn)
    monkeypatch.setattr(elements, "stay", asked.append)
    asyncio.run(figure.draw({"data": 1}))
    assert asked == [("draw", ({"data": 1},), 5.0), figure]


def test_a_form_that_could_not_be_kept_once_is_kept_again(bench, monkeypatch):
    kept = []
    monkeypatch.setattr(layout, "attempt", lambda do: kept.append(do) is None and len(kept) > 1)
    bench.keep(bench.form)
    assert bench.kept is False
    bench.keep(bench.form)
    assert (bench.kept, len(kept)) == (True, 2)


def test_all_that_belongs_to_the_mission_before_is_grey(session, tab, monkeypatch):
    monkeypatch.setattr(layout, "follow", lambda session, show: lambda: None)
    page = link.LinkPage(session)
    page.build()
    assert page.dimmed == (page.cards, page.map, page.key, page.words, page.table)


def test_a_recording_that_can_no_longer_be_read_says_why_in_place_of_its_samples(bench, monkeypatch):
    """Its channels are read again where the studio has started anew."""
    put_in(bench, "a.csv")
    asyncio.run(bench.take(bench.files["a"]))
    bench.listings.clear()
    bench.shown = ""

    def refuse(path):
        raise mirror.reading.ReadingError("a.csv: cut short")

    monkeypatch.setattr(mirror.reading, "list_channels", refuse)
    asyncio.run(bench._measured())
    assert (bench.words.text, bench.about.text) == ("a.csv: cut short", "")
    assert asyncio.run(bench._look_into("", bench.form.setting)) == (None, "")


def test_the_figures_of_an_identification_stand_under_their_own_names(job_view):
    labels = [each.props["aria-label"] for each in (job_view.loop, job_view.residual)]
    assert labels == ["Measured loop and that of the model", "Residual over time"]


# ------------------------------------------------------------------------------------------- what is rarely the case
@pytest.mark.parametrize("preset", ["tbird", None])
def test_a_mission_that_comes_with_microrad_is_chosen_on_every_page_that_compares_with_it(session, compared, preset):
    option = compare._SHIPPED if preset is None else compare._PRESET + preset
    compared.choice.value = option
    assert session.other.text == (Draft.shipped("").text if preset is None else preset_text(preset))
    assert compared._compared(compared._options()) == option
    assert compared._name(session.other) == option
    another = compare._Page(session)
    assert (another.choice.value, another.shown) == (option, option)


def test_another_mission_that_cannot_be_kept_on_disk_is_not_compared_with_and_says_why(session, compared, monkeypatch):
    def full(draft, name):
        raise OSError("the disk is full")

    monkeypatch.setattr(session, "_keep", full)
    compared._chosen(SimpleNamespace(value=compare._SHIPPED))
    assert (compared.fault.text, session.other) == ("the disk is full", None)


@pytest.mark.parametrize(("rate_hz", "half"), [(1000.0, "500 Hz"), (30000.0, "")])
def test_a_sine_is_refused_by_the_rate_of_the_controller_that_is_shown(session, controls, monkeypatch, rate_hz, half):
    """The sine of 2.5 kHz is half of what the other controllers sample with."""
    monkeypatch.setattr(control, "_controller", lambda file, name: controller(name, rate_hz=rate_hz))
    asyncio.run(controls.reload())
    controls.filling = True
    controls.frequency.value = "2.5 kHz"
    controls.filling = False
    asyncio.run(controls.show())
    assert (f"2.5 kHz is not below {half}, half the rate" in controls.fault.text) is bool(half)
    assert bool(controls.fault.text) is bool(half)


@pytest.mark.parametrize("how", ["in its place", "beside it"])
def test_a_file_that_the_mission_names_is_another_although_its_size_or_its_time_is_the_same(naming, how):
    """In place: of the same size, at another time. Another file in its stead: of the same size and time."""
    path = naming.folder / "shake.csv"
    before, key, revision = path.stat(), naming.key, naming.revision
    text = path.read_text("utf-8").replace("0.1, 100", "0.1, 900")
    if how == "in its place":
        path.write_text(text, "utf-8")
        os.utime(path, ns=(before.st_atime_ns, before.st_mtime_ns + 1000))
    else:
        new = path.with_name("new.csv")
        new.write_text(text, "utf-8")
        os.utime(new, ns=(before.st_atime_ns, before.st_mtime_ns))
        new.replace(path)
    assert path.stat().st_size == before.st_size
    assert naming.key != key and naming.disk == "" and naming.revision == revision + 1


def test_a_loop_that_cannot_be_simulated_says_why_and_is_not_waited_for(session, controls, monkeypatch):
    def ask(ask, variants):
        raise ValueError("the loop is not stable")

    monkeypatch.setattr(control, "_controller", lambda file, name: controller(name, ask=ask))
    asyncio.run(controls.reload())
    assert (controls.fault.text, controls.state.text) == ("the loop is not stable", "")
    assert behind(controls) == set(controls.plots) - {"sensitivity", "gain"}
    assert controls.drawn == ["PI"]


def test_of_all_controllers_the_one_that_is_tuned_anew_keeps_its_row_meanwhile(session, controls, monkeypatch):
    asyncio.run(controls.reload())
    rows = []

    async def looked(element, work, *args):
        rows.append([each if isinstance(each, str) else each.name for each in controls.found.values()])
        return work(*args)

    monkeypatch.setattr(control, "in_thread", looked)
    asyncio.run(controls.tune_all())
    new, now = "not looked at yet", "being tuned ..."
    assert rows == [
        [now, "PI", new, new],
        ["baseline", "PI", new, new],
        ["baseline", "PI", now, new],
        ["baseline", "PI", "PID", now],
    ]


def test_tuning_that_was_stopped_does_not_end_the_one_that_was_begun_after_it(session, controls, monkeypatch):
    gates = []

    async def slow(element, work, *args):
        gates.append(asyncio.Event())
        await gates[-1].wait()
        return work(*args)

    async def twice():
        first = asyncio.create_task(controls.tune_all())
        await asyncio.sleep(0)
        controls.stop_all()
        second = asyncio.create_task(controls.tune_all())
        await asyncio.sleep(0)
        gates[0].set()
        await first
        seen = [(controls.tune.visible, controls.stop.visible, [*controls.made])]
        while not second.done():
            for gate in gates:
                gate.set()
            await asyncio.sleep(0)
        return [*seen, (controls.tune.visible, controls.stop.visible, [*controls.made])]

    asyncio.run(controls.reload())
    controls.made.clear()
    monkeypatch.setattr(control, "in_thread", slow)
    all_four = ["baseline", "PI", "PID", "inverse"]
    assert asyncio.run(twice()) == [(False, True, ["baseline"]), (True, False, ["baseline", *all_four])]


@pytest.mark.parametrize(("margin", "dashed"), [("4.5 dB", " Dashed line: 0 dB."), ("0 dB", "")])
def test_margins_map_and_words_of_the_links_are_those_of_what_is_seen(session, links, monkeypatch, margin, dashed):
    shows = []

    async def draw(plot):
        shows.append(("map", plot))

    session.set("requirement.margin", margin)
    view = links._view(session.link())
    monkeypatch.setattr(links.cards, "show", lambda margins: shows.append(("cards", margins)))
    monkeypatch.setattr(links.map, "draw", draw)
    monkeypatch.setattr(link_view, "map_plot", id)
    asyncio.run(links.show(view))
    assert shows == [("cards", view.margins), ("map", id(view))]
    assert [each.name for each in view.margins] == ["Communication", "Beacon", "Answer"]
    links.view_now = view
    links.show_rest(view)
    assert links.key.text == f"Solid line: the required {margin}.{dashed} Dot: the working point."
    assert links.words.text == link_view.map_words(view) and f"for the required {margin}." in links.words.text
    assert links.which.options == ["Communication", "Beacon", "Answer"]


def test_the_map_keeps_its_axes_while_the_mission_lies_within_them(session, links):
    rate = "communication.data_rate"
    links.view_now = links._view(session.link())
    frame = links.view_now.frame
    low, high = (float(frame.data_rate_bit_s[k]) for k in (0, -1))
    session.set(rate, f"{1.5 * low / 1e6:g} Mbit/s")
    links.view_now = links._view(session.link())
    assert links.view_now.frame is frame
    session.set(rate, f"{0.5 * low / 1e6:g} Mbit/s")
    links.view_now = links._view(session.link())
    assert links.view_now.frame.data_rate_bit_s[0] < low < high


def test_what_follows_from_the_links_is_shown_with_its_own_figures(session, links, monkeypatch):
    pictures = tuple(Drawing(name, f"title {name}", "", "<svg/>") for name in "ab")
    monkeypatch.setattr(link, "_told", lambda result: (pictures, {"a": f"data:a{result}", "b": f"data:b{result}"}))
    for key, result in (("one", 1), ("two", 2)):
        links.study.state = State(key, result=result)
        asyncio.run(links._look())
        found = [each.props["src"] for each in links.told.descendants() if "src" in each.props]
        assert (links.shown, found) == (key, [f"data:a{result}", f"data:b{result}"])


def test_an_identification_that_is_begun_is_the_one_that_is_shown(bench, monkeypatch):
    followed, orders = [], []

    async def follow(number):
        followed.append(number)

    def submit(order):
        orders.append(order)
        if len(orders) == 2:
            raise JobError("the queue is held by another program")
        return SimpleNamespace(number=17)

    action = commands.identify([Path("a.csv")], "0", "1", Path("m.toml"), name="m")
    monkeypatch.setattr(bench, "action", lambda: action)
    monkeypatch.setattr(bench.session.jobs, "submit", submit)
    monkeypatch.setattr(bench.job, "follow", follow)
    asyncio.run(bench.start())
    assert (followed, bench.words.text) == ([17], "")
    asyncio.run(bench.start())
    assert (followed, bench.words.text) == ([17], "the queue is held by another program")
    assert orders == [mirror_form.order(bench.session.folder, action)] * 2


def test_why_a_recording_cannot_be_measured_is_told_in_the_words_of_the_form(bench, monkeypatch):
    """Those of the reader name the options of the command."""

    def refuse(path, columns):
        words = "give the rate (--rate, rate_hz) in Hz, or name the time column (time)"
        raise mirror.reading.ReadingError(f"{path.name}: {words}.")

    put_in(bench, "a.csv", "b.csv")
    monkeypatch.setattr(mirror.reading, "view", refuse)
    asyncio.run(bench.take(bench.files["a"]))
    asyncio.run(bench.check())
    asyncio.run(bench.look())
    assert bench.words.text == "a.csv: type the sample rate."
    assert [text for text in texts(bench.list) if ":" in text] == [f"{n}.csv: type the sample rate." for n in "ab"]


def test_the_name_of_the_recording_that_is_shown_stands_out_in_the_list(bench):
    def outstanding():
        return [each.text for each in bench.list.descendants() if "seen" in getattr(each, "classes", ())]

    put_in(bench, "a.csv", "b.csv", "c.csv")
    asyncio.run(bench.take(bench.files["a"]))
    for _ in range(3):
        asyncio.run(bench.check())
    asyncio.run(bench.look())
    assert outstanding() == ["a.csv"]
    for key in "bca":
        asyncio.run(bench.see(key))
        assert outstanding() == [f"{key}.csv"]


def test_each_recording_keeps_its_own_use_and_others_are_fitted(bench):
    put_in(bench, "a.csv", "b.csv", "c.csv")
    bench.use("b", "leave")
    bench.use("c", "check")
    assert [(each.name, each.use) for each in bench.dropped()] == [
        ("a.csv", "fit"),
        ("b.csv", "leave"),
        ("c.csv", "check"),
    ]
    bench.use("b", "fit")
    assert mirror_form.kept_form(bench.path).uses == {"b": "fit", "c": "check"}


def test_a_mirror_gets_its_name_from_the_recording_that_is_shown_first(bench):
    put_in(bench, "stage.csv")
    asyncio.run(bench.look())
    assert (bench.form.seen, bench.form.setting.name, bench.fields["name"].value) == (
        "s",
        "stage-mirror",
        "stage-mirror",
    )


def test_the_identification_that_was_chosen_tells_its_own_end_and_is_cancelled(session, job_view, monkeypatch):
    view, asked, cancelled, scored = job_view, [], [], []
    monkeypatch.setattr(session.jobs, "output", lambda number: f"said by {number}")
    monkeypatch.setattr(session.jobs, "cancel", cancelled.append)
    monkeypatch.setattr(mirror_job.mirror_view, "outcome", lambda text: asked.append(text) or ("a", (Soft(text),)))
    monkeypatch.setattr(
        mirror_job.mirror_view,
        "score_rows",
        lambda fits, chosen: scored.append((len(fits), chosen)) or [("m", "1 %", "2 %", chosen)],
    )
    view.jobs = [
        identified(session.folder, 3, "failed"),
        identified(session.folder, 2, "done"),
        identified(session.folder, 1, "cancelled"),
    ]
    view.read = {"3": fits("c"), "2": fits("a", "b", loops=2), "1": fits("d", "e", "f")}
    for number in (3, 2, 1):
        asyncio.run(view.choose(SimpleNamespace(value=number)))
        view.stop()
        if number == 2:
            assert texts(view.told) == ["said by 2"]
            assert [row["c3"] for row in view.table.rows] == ["a"]
    assert (asked, cancelled, scored) == (["said by 2"], [3, 2, 1], [(1, ""), (2, "a"), (3, "")])
    assert (texts(view.told), view.words.text) == ([], "cancelled f")


def test_the_recording_that_was_chosen_stays_while_more_models_come(session, job_view):
    view = job_view
    view.jobs, view.read = [identified(session.folder, 1)], {"1": fits("a", loops=3)}
    asyncio.run(view.look())
    view.recording.value = 2
    view.draw()
    first = view.read["1"]
    view.read = {"1": (*first, *fits("better", loops=3))}
    view.read["1"][1].held_out_rms_percent = 1.0
    asyncio.run(view.look())
    assert (view.recording.value, view.drawn_fits) == (2, [("a", 0, "mV"), ("a", 2, "mV"), ("better", 2, "mV")])


def test_both_plots_of_pointing_are_drawn_each_in_its_own_place(session, tab, monkeypatch):
    monkeypatch.setattr(layout, "follow", lambda session, show: lambda: None)
    shows, page = [], pointing.PointingPage(session)
    for name in ("coverage_plot", "lines_plot"):
        monkeypatch.setattr(pointing.pointing_view, name, lambda view, name=name: (name, view))

    def drawing(place):
        async def draw(plot):
            shows.append((place, *plot))

        return draw

    for place in ("coverage", "bars"):
        monkeypatch.setattr(getattr(page, place), "draw", drawing(place))
    asyncio.run(page.show("the view"))
    assert shows == [("coverage", "coverage_plot", "the view"), ("bars", "lines_plot", "the view")]


def test_a_budget_of_errors_is_shown_with_its_figures_and_not_in_grey(session, tab, monkeypatch):
    monkeypatch.setattr(layout, "follow", lambda session, show: lambda: None)
    page, view = pointing.PointingPage(session), SimpleNamespace(file=None)
    drawing = Drawing("errors", "Errors", "caption", "<svg/>")
    monkeypatch.setattr(pointing, "_budget", lambda file, table: View("", [drawing]))
    monkeypatch.setattr(pointing, "drawn", lambda blocks: {each.name: "data:errors" for each in blocks})
    layout.grey(page.budget, True)
    page.view_now = None
    asyncio.run(page._errors(view, "table"))
    assert "behind" in page.budget.classes
    page.view_now = view
    asyncio.run(page._errors(view, "table"))
    assert [each.props["src"] for each in page.budget.descendants() if "src" in each.props] == ["data:errors"]
    assert "behind" not in page.budget.classes


def test_a_ledger_is_named_like_its_campaign_file_up_to_the_last_dot_and_anew_after_each_run(session, tab, monkeypatch):
    (session.folder / "day.v1.toml").write_text('mission = "leo-geo.toml"', "utf-8")
    campaign, ran = runs._Campaign(session), []

    def submit(order):
        ran.append(order.arguments[-1])
        (session.folder / order.results[0]).touch()

    monkeypatch.setattr(session.jobs, "submit", submit)
    asyncio.run(campaign._look())
    assert campaign.ledger.value == "day.v1.ledger"
    for name in ("day.v1.ledger", "day.v1-2.ledger"):
        asyncio.run(campaign._run())
        assert ran[-1] == name
    assert campaign.ledger.value == "day.v1-3.ledger"
    asyncio.run(campaign._look())
    campaign.file.value = "day.v1-2.ledger (go on)"
    asyncio.run(campaign._name())
    assert (campaign.ledger.value, campaign.ledger.enabled) == ("day.v1-2.ledger", False)


def test_an_example_that_the_disk_does_not_take_says_why(session, tab, monkeypatch):
    def full(session):
        raise OSError("the disk is full")

    monkeypatch.setattr(runs, "write_campaign", full)
    campaign = runs._Campaign(session)
    asyncio.run(campaign._example())
    assert (campaign.fault.text, campaign.file.value) == ("the disk is full", None)


def test_a_study_of_a_mission_that_is_not_saved_is_copied_with_a_warning(session, tab, monkeypatch):
    copied, notes = [], []
    monkeypatch.setattr(layout, "_copy", lambda action, python: copied.append(action))
    monkeypatch.setattr(layout.ui, "notify", lambda words, **settings: notes.append((words, settings["type"])))
    study = runs._Study(session)
    study.folder.value = "out"
    action = commands.study(Path("leo-geo.toml"), Path("out"))
    press(buttons(tab.content)["Copy as command"])
    assert (copied, notes) == ([action], [])
    session.set(LEO, "6 cm")
    press(buttons(tab.content)["Copy as Python"])
    words = "The command reads the file: save the mission first, for the same numbers."
    assert (copied, notes) == ([action, action], [(words, "warning")])


def test_how_long_a_job_runs_is_told_at_each_look_although_nothing_else_is_new(session, cards, monkeypatch):
    job = Job(2, session.folder, "running", "study", "mine", progress=Progress(1, 3, "rows"))
    card = runs_jobs._Card(cards, job)
    for words in ("for 1 s", "for 2 s"):
        monkeypatch.setattr(runs_jobs, "time_words", lambda job, words=words: words)
        shown(card, job)
        assert (card.when.text, card.bar.value) == (words, 0.3333)


def test_a_panel_looks_at_its_ledger_while_it_is_open_alone(session, tab):
    panel = runs_jobs.CampaignPanel(session, session.folder / "x.ledger")
    seen = [(panel.place.visible, panel._timer.active)]
    for panel.open in (True, False, True):
        seen.append((panel.place.visible, panel._timer.active))
    assert seen == [(False, False), (True, True), (False, False), (True, True)]


def test_a_panel_tells_the_fault_that_its_ledger_has_now(session, tab, monkeypatch):
    panel = runs_jobs.CampaignPanel(session, session.folder / "x.ledger")
    looked = []
    monkeypatch.setattr(runs_jobs, "figures", lambda live: found_figures(live.fault or "none"))
    for fault in ("row 3 is damaged", "row 5 is damaged", ""):
        monkeypatch.setattr(
            session.campaigns, "look", lambda path, fault=fault: looked.append(path) or SimpleNamespace(fault=fault)
        )
        asyncio.run(panel._look())
        assert (panel._fault.text, panel._fault.visible) == (fault, bool(fault))
        assert [*panel._chosen.options] == [fault or "none"]
    assert looked == [session.folder / "x.ledger"] * 3


def test_of_two_jobs_of_one_ledger_the_newer_goes_on_and_has_the_report(session, cards, monkeypatch):
    (session.folder / "x.ledger").touch()
    (session.folder / "sub").mkdir()
    (session.folder / "sub" / "x.html").touch()

    def job(number, state, kind, arguments, *results):
        return Job(number, session.folder, state, kind, "t", arguments, session.folder, results)

    begun = job(1, "cancelled", "campaign", ("campaign", "run", "c.toml", "--ledger", "x.ledger"), "x.ledger")
    resumed = job(2, "done", "campaign", ("campaign", "resume", "x.ledger"), "x.ledger")
    report = job(3, "done", "export", ("campaign", "report", "x.ledger", "sub/x.html", "--overwrite"), "sub/x.html")
    for jobs in ((begun,), (resumed, begun), (report, resumed, begun)):
        monkeypatch.setattr(session.jobs, "listed", lambda jobs=jobs: jobs)
        asyncio.run(cards.refresh())
        first = cards._cards[1]
        assert (first.again.visible, first.results.visible, texts(first.report)) == (len(jobs) == 1, len(jobs) == 1, [])
    second = cards._cards[2]
    assert texts(second.report) == ["Show x.html here", "sub/x.html in a tab of its own"]
    assert (second.page.visible, second.again.visible, second.results.visible) == (False, False, True)


def test_a_job_that_cannot_be_queued_for_the_disk_says_why(session, tab, told, monkeypatch):
    done = []
    monkeypatch.setattr(session.jobs, "submit", done.append)

    def full():
        raise OSError("the disk is full")

    place = ui.row()
    assert asyncio.run(runs_jobs.submit(place, session, lambda: "an order")) is True
    assert asyncio.run(runs_jobs.submit(place, session, full)) is False
    assert (done, told) == (["an order"], ["the disk is full"])


@pytest.mark.parametrize("error", [OSError("the disk is full"), ValueError("no such key")])
def test_a_slider_whose_value_cannot_be_written_says_why_and_shows_nothing_new(board, told, monkeypatch, error):
    def refuse(key, typed):
        raise error

    monkeypatch.setattr(board.session, "set", refuse)
    asyncio.run(board._set(LEO, "6 cm"))
    assert (told, board.shows, board.last) == ([str(error)], [], None)


def test_what_is_shown_follows_the_sliders_and_the_mission(session, board, told, monkeypatch):
    """One that moves is shown with its value, in the mission as another tab has set it meanwhile."""
    geo = "terminals.geo_aperture"

    def seen():
        held = board.shows[-1].mission.terminals
        return len(board.shows), round(100.0 * held.leo_aperture_m), round(100.0 * held.geo_aperture_m)

    marks = []
    monkeypatch.setattr(board, "_mark", lambda: marks.append(session.draft.values[LEO].typed))
    asyncio.run(board._reload())
    first = seen()
    asyncio.run(board._reload())
    assert (first[:2], seen()) == ((1, 5), first)  # nothing is new
    asyncio.run(board._set(LEO, "6 cm"))
    assert (seen()[:2], marks, board.board.rows[LEO].typed) == ((2, 6), ["6 cm"], "6 cm")
    board.board.rows[LEO]._begin("8 cm")
    session.set(geo, "21 cm")
    asyncio.run(board._reload())
    assert seen() == (3, 8, 21)
    assert session.draft.values[LEO].typed == "6 cm" and told == []
    asyncio.run(board._try("no.such.key", "1"))
    assert len(told) == 1 and "no.such.key" in told[0]
    asyncio.run(board._try(geo, "22 cm"))  # it is not busy with what was refused
    assert seen() == (4, 6, 22)


def test_of_questions_that_wait_the_newest_alone_is_answered(session, board, monkeypatch):
    gate, asked = asyncio.Event(), []

    async def slow(page, question):
        await gate.wait()
        return question()

    def question(name):
        def ask():
            asked.append(name)
            return Attempt(session.draft.with_text(f"{TEXT}# {name}\n"), name)

        return ask

    async def three():
        first = asyncio.create_task(board._ask(question("first")))
        await asyncio.sleep(0)
        for name in ("second", "third"):
            await board._ask(question(name))
        gate.set()
        await first

    monkeypatch.setattr(sliders, "in_thread", slow)
    asyncio.run(three())
    assert (asked, board.shows, board._busy) == (["first", "third"], ["first", "third"], False)


def test_the_form_begins_anew_with_a_recording_where_nothing_was_chosen_for_one_before(bench):
    bench.answers["words.csv"] = Listing((), None, ())
    put_in(bench, "words.csv", "stage.csv")
    asyncio.run(bench.take(bench.files["w"]))
    assert (bench.form.seen, bench.form.setting.name, bench.form.setting.drive) == ("w", "words-mirror", None)
    asyncio.run(bench.take(bench.files["s"]))
    assert (bench.form.seen, bench.form.setting.name, bench.form.setting.drive) == ("s", "stage-mirror", 0)
    bench.keep(replace(bench.form, setting=replace(bench.form.setting, name="mine", drive=None)))
    asyncio.run(bench.see("s"))
    assert bench.form.setting.name == "mine"  # it is shown already


def test_the_form_begins_anew_once_all_recordings_were_removed(bench):
    put_in(bench, "stage.csv")
    asyncio.run(bench.take(bench.files["s"]))
    asyncio.run(bench.remove("s"))
    assert (bench.form.seen, bench.form.setting.name) == ("", "stage-mirror")
    put_in(bench, "other.csv")
    asyncio.run(bench.take(bench.files["o"]))
    assert (bench.form.seen, bench.form.setting.name) == ("o", "other-mirror")


TURNS = {
    "a verdict": (Verdict("so", (), True), Verdict("so", (), False)),
    "a title": (View("one", ("text",)), View("two", ("text",))),
    "what is folded": (View("one", ("text",), folded=True), View("one", ("text",), folded=False)),
    "a table that is folded": (Table("t", ("x",), [("1",)]), Table("t", ("x",), [("1",)], folded="1 row")),
    "rows and sums": (Table("t", ("x",), [("1",), ("2",)], totals=1), Table("t", ("x", "y"), [("1", "3")])),
    "a kind": (Soft("the text"), Verbatim("the text")),
    "a text": ("one", "two"),
    "points": (Points(("a", "b", "c")), Points(("a", "d"))),
    "a figure": (Drawing("a", "one", "caption", "<svg/>"), Drawing("b", "two", "caption", "<svg/>")),
    "a caption": (Drawing("a", "one", "before", "<svg/>"), Drawing("a", "one", "after", "<svg/>")),
    "one within": (View("v", (Verdict("so", (), True),)), View("v", (Verdict("no", (), False), "more"))),
}


@pytest.mark.parametrize("what", TURNS)
@pytest.mark.parametrize("back", [False, True])
def test_blocks_that_take_the_place_of_others_look_as_if_they_were_the_first(tab, what, back):
    turns = [(Soft("before"), each, "behind") for each in TURNS[what]]
    figures = {"a": "data:a", "b": "data:b"}
    first, second = (elements.Blocks() for _ in range(2))
    for blocks in turns[::-1] if back else turns:
        first.show_blocks(blocks, figures)
    second.show_blocks(blocks, figures)
    assert outline(first) == outline(second) != []
    assert texts(first)[0] == "before" and texts(first)[-1] == "behind"


def test_another_mission_ends_the_tuning_of_all_controllers(session, controls, monkeypatch):
    gates = []
    asyncio.run(controls.reload())

    async def slow(element, work, *args):
        gates.append(asyncio.Event())
        if len(gates) == 1:
            await gates[0].wait()
        return work(*args)

    async def changed():
        tuning = asyncio.create_task(controls.tune_all())
        await asyncio.sleep(0)
        before = controls.tune.visible, controls.stop.visible
        session.set(LEO, "6 cm")
        await controls.reload()
        gates[0].set()
        await tuning
        return before, (controls.tune.visible, controls.stop.visible)

    monkeypatch.setattr(control, "in_thread", slow)
    assert asyncio.run(changed()) == ((False, True), (True, False))


def test_a_late_refusal_of_an_older_question_is_dropped_as_a_late_answer_is(session, controls, monkeypatch):
    gate = asyncio.Event()

    def ask(ask, variants):
        raise ValueError("the loop is not stable")

    async def slow(element, work, *args):
        if work is ask:
            await gate.wait()
        return work(*args)

    async def both():
        older = asyncio.create_task(controls.show())
        while controls.state.text != "Simulating ...":
            await asyncio.sleep(0)
        controls.filling = True
        controls.name.value = "PID"
        controls.filling = False
        await controls.show()
        gate.set()
        await older

    asyncio.run(controls.reload())
    monkeypatch.setattr(control, "in_thread", slow)
    monkeypatch.setattr(
        control, "_controller", lambda file, name: controller(name, **({"ask": ask} if name == "PI" else {}))
    )
    asyncio.run(both())
    assert (controls.fault.text, controls.state.text, behind(controls)) == ("", "", set())


def test_a_study_of_a_file_that_another_program_has_changed_or_removed_is_not_run(session, tab, asked, told):
    study = runs._Study(session)
    study.folder.value = "out"
    path = session.draft.path
    name = session.name_of(path)
    path.write_text(f"{TEXT}\n# of another program\n", "utf-8")
    study._look()
    changed = study.fault.text
    assert changed.startswith(f"{name} was changed on disk by another program") and not study.button.enabled
    asyncio.run(study._run())
    path.unlink()
    asyncio.run(study._run())
    assert (study.fault.text, asked.orders, told) == (f"{name} is not on disk any more; save it again", [], [])
    path.write_text(session.draft.text, "utf-8")
    study._look()
    assert (study.fault.text, study.button.enabled) == ("", True)


def test_figures_that_were_hidden_stay_hidden_while_their_campaign_goes_on(session, cards):
    (session.folder / "x.ledger").touch()
    job = Job(2, session.folder, "running", "campaign", "t", ("campaign",), session.folder, ("x.ledger",))
    card = shown(runs_jobs._Card(cards, job), job, Others(newest=True, latest=True))
    panel = card._panel
    card._toggle()
    for more in (
        {"progress": Progress(3, 4, "rows")},
        {"progress": Progress(4, 4, "rows"), "state": "done", "code": 0},
    ):
        shown(card, replace(job, **more), Others(newest=True, latest=True))
        assert (panel.open, card.figures.text) == (False, "Show its figures")
    assert card._panel is panel and texts(card.place).count("Reading the ledger ...") == 1
    card._toggle()
    assert (panel.open, card.figures.text) == (True, "Hide its figures")


def test_a_panel_tells_the_fault_of_a_ledger_of_which_no_row_could_be_read(session, tab):
    path = session.folder / "x.ledger"
    path.write_bytes(b"no ledger at all" * 100)
    panel = runs_jobs.CampaignPanel(session, path)
    asyncio.run(panel._look())
    assert "is no ledger" in panel._fault.text
    assert (panel._fault.visible, panel._rows.visible) == (True, False)


@pytest.mark.parametrize(
    ("state", "code", "look"),
    [
        ("queued", None, "soft"),
        ("running", None, "soft"),
        ("cancelled", 130, "soft"),
        ("failed", 2, "no"),
        ("failed", 1, "no"),
        ("lost", None, "no"),
        ("unreadable", None, "no"),
        ("done", 0, "yes"),
        ("done", 1, "no"),
    ],
)
@pytest.mark.parametrize("kind", ["study", "campaign", "identification", "export"])
def test_every_state_of_every_kind_of_job_has_its_colour_and_its_buttons(session, cards, kind, state, code, look):
    job = Job(3, session.folder, state, kind, "mine", code=code)
    card = shown(runs_jobs._Card(cards, job), job)
    assert [name for name in ("yes", "no", "soft") if name in card.state.classes] == [look]
    over = state not in ("queued", "running")
    assert (card.cancel.visible, card.drop.visible, card.bar.visible) == (not over, over, state == "running")
    assert ("open" in card.details.props) is (kind in ("study", "export"))
    assert card.again.visible is card.page.visible is card.figures.visible is False  # no ledger is there


@pytest.mark.parametrize("python", [False, True])
@pytest.mark.parametrize(
    ("module", "command"),
    [
        (mission, "budget"),
        (control, "design"),
        (day, "contacts"),
        (link, "budget"),
        (pointing, "budget"),
        (compare, "budget"),
    ],
    ids=lambda each: getattr(each, "TITLE", each),
)
def test_each_page_copies_the_command_that_computes_what_it_shows(inner, tab, monkeypatch, module, command, python):
    copied = []

    monkeypatch.setattr(layout, "_copy", lambda action, python: copied.append((action, python)))
    module.page(inner)
    words = "Copy as Python" if python else "Copy as command"
    press(next(each for each in tab.content.descendants() if getattr(each, "text", "") == words))
    assert copied == [(getattr(commands, command)(Path("sub/m n.toml")), python)]


@pytest.mark.parametrize("page", [control.ControlPage, mission._Page])
def test_a_command_of_a_mission_that_is_not_saved_is_copied_with_a_warning(session, tab, monkeypatch, page):
    copied, notes = [], []
    monkeypatch.setattr(layout, "_copy", lambda action, python: copied.append(action))
    monkeypatch.setattr(layout.ui, "notify", lambda words, **settings: notes.append((words, settings["type"])))
    page(session)
    press(buttons(tab.content)["Copy as command"])
    session.set(LEO, "6 cm")
    press(buttons(tab.content)["Copy as Python"])
    words = "The command reads the file: save the mission first, for the same numbers."
    of = (commands.design if page is control.ControlPage else commands.budget)(Path("leo-geo.toml"))
    assert (copied, notes) == ([of, of], [(words, "warning")])


@pytest.mark.usefixtures("tab")
def test_a_slider_that_was_moved_goes_back_with_the_text_that_it_had(session, monkeypatch):
    found, shown = slider_of(session, "terminals.leo_aperture"), []

    async def nothing(key, text):
        pass

    row = sliders.SliderRow(found, nothing, nothing)
    monkeypatch.setattr(row, "run_method", lambda name, new: shown.append((name, new)))
    asyncio.run(heard_by(row)["try_place"](SimpleNamespace(args=found.position + 5)))
    asyncio.run(heard_by(row)["set_text"](SimpleNamespace(args=found.typed)))
    assert [name for name, _ in shown] == ["show", "show"]
    assert shown[0][1] == {"text": found.at(found.position + 5)}
    assert shown[1][1]["place"] == found.position and row.typed == found.typed


def test_a_panel_of_a_ledger_without_rows_says_so_and_draws_nothing_of_before(session, tab, monkeypatch):
    panel = runs_jobs.CampaignPanel(session, session.folder / "x.ledger")
    drawn, found = [], [found_figures("a", "b")]
    monkeypatch.setattr(panel._plot, "show", drawn.append)
    monkeypatch.setattr(session.campaigns, "look", lambda path: SimpleNamespace(fault=""))
    monkeypatch.setattr(runs_jobs, "figures", lambda live: found[0])
    asyncio.run(panel._look())
    before, found[0] = len(drawn), None
    asyncio.run(panel._look())
    assert (panel._rows.visible, panel._rows.text) == (True, "No row is in the ledger yet.")
    panel._draw()
    assert before > 0 and len(drawn) == before


def test_results_of_a_job_that_ends_once_more_stand_there_once(session, cards):
    for name in ("x.nc", "y.nc"):
        (session.folder / name).touch()
    lost = Job(1, session.folder, "lost", "study", "t", (), session.folder, ("x.nc", "y.nc"))
    card = runs_jobs._Card(cards, lost)
    for job in (lost, replace(lost, state="running"), replace(lost, state="done")):
        shown(card, job)
    assert texts(card.results) == ["Save x.nc", "Save y.nc"]


def test_one_recording_beside_the_one_that_is_shown_is_read_at_each_look(bench):
    put_in(bench, "a.csv", "b.csv", "c.csv", "d.csv")
    asyncio.run(bench.take(bench.files["c"]))
    read = []
    for _ in range(4):
        asyncio.run(bench.check())
        read.append([name for name, _ in bench.read])
    assert read == [["c.csv", *["a.csv", "b.csv", "d.csv"][:count]] for count in (1, 2, 3, 3)]


def test_the_fault_of_the_recording_that_is_shown_stands_below_it_too(bench, monkeypatch):
    put_in(bench, "a.csv", "b.csv")

    def refuse(path, columns):
        raise mirror.reading.ReadingError(f"{path.name}: odd")

    monkeypatch.setattr(mirror.reading, "view", refuse)
    asyncio.run(bench.take(bench.files["b"]))
    asyncio.run(bench.look())
    assert (bench.words.text, texts(bench.list).count("b.csv: odd")) == ("b.csv: odd", 1)
    assert "a.csv: odd" not in texts(bench.list)


def test_a_recording_that_is_turned_to_is_measured_at_once_and_its_channels_are_read_once(bench, monkeypatch):
    listed = []
    monkeypatch.setattr(mirror.reading, "list_channels", lambda path: listed.append(path.name) or CHANNELS)
    put_in(bench, "a.csv", "b.csv", "c.csv")
    asyncio.run(bench.take(bench.files["a"]))
    assert (listed, [name for name, _ in bench.read]) == (["a.csv"], ["a.csv"])
    for key in ("c", "b", "c"):
        asyncio.run(bench.see(key))
        assert (bench.read[-1][0], bench.form.seen) == (f"{key}.csv", key)
    assert listed == ["a.csv", "c.csv", "b.csv"]


def test_the_channels_of_a_recording_that_was_checked_are_known(bench):
    """Its units are held against those of the form when the mirror is identified."""
    bench.answers["b.csv"] = Listing((ChannelInfo("drive [mV]", "", 9), ChannelInfo("angle [mrad]", "", 9)), None, ())
    put_in(bench, "a.csv", "b.csv")
    asyncio.run(bench.take(bench.files["a"]))
    assert [each.listing for each in bench.dropped()] == [CHANNELS, None]
    asyncio.run(bench.check())
    assert [each.listing for each in bench.dropped()] == [CHANNELS, bench.answers["b.csv"]]
    assert bench.action() is None
    assert "unit of the drive: the form says V and b.csv says mV" in bench.words.text


def test_other_columns_that_are_chosen_are_measured_at_once(bench):
    put_in(bench, "a.csv")
    asyncio.run(bench.take(bench.files["a"]))
    bench.filling = True
    bench.fields["drive"].value, bench.fields["output"].value = 1, 0
    bench.filling = False
    asyncio.run(bench.typed())
    assert [(columns.inputs, columns.outputs) for _, columns in bench.read] == [((0,), (1,)), ((1,), (0,))]


def test_of_two_recordings_that_are_measured_the_one_that_was_turned_to_last_is_shown(bench, monkeypatch):
    put_in(bench, "a.csv", "b.csv")
    shows, begun, go_on = [], [], asyncio.Event()
    monkeypatch.setattr(bench, "_show", lambda view, words: shows.append(words))

    async def look_into(key, setting):
        begun.append(key)
        if key == "a":
            await go_on.wait()
        return None, f"about {key}"

    monkeypatch.setattr(bench, "_look_into", look_into)

    async def both():
        bench.form = replace(bench.form, seen="a")
        first = asyncio.create_task(bench._measured())
        await asyncio.sleep(0)
        bench.form = replace(bench.form, seen="b")
        await bench._measured()
        go_on.set()
        await first

    asyncio.run(both())
    assert (begun, shows) == (["a", "b"], ["about b"])


def test_of_two_controllers_that_are_asked_for_the_later_one_is_shown_although_the_first_is_tuned_last(
    session, controls, monkeypatch
):
    page = controls
    asyncio.run(page.reload())
    page.drawn.clear()
    gate = asyncio.Event()

    async def slow(element, work, *args):
        if args[-1] == "PI":
            await gate.wait()
        return work(*args)

    monkeypatch.setattr(control, "in_thread", slow)

    async def both():
        first = asyncio.create_task(page.show())
        await asyncio.sleep(0)
        page.filling = True  # no task for what is put in by hand
        page.name.value = "PID"
        page.filling = False
        await page.show()
        shown = list(page.drawn)
        gate.set()
        await first
        return shown

    shown = asyncio.run(both())
    assert (shown[0], page.drawn, page.state.text) == ("PID", shown, "")


def test_the_fault_of_what_is_tried_stands_beside_its_own_slider_until_it_is_right(session, board, monkeypatch):
    board.board.show(link_view.sliders(session.draft))
    beside = {}
    for key, row in board.board.rows.items():
        monkeypatch.setattr(row, "fault", lambda words, key=key: beside.update({key: words}))
    asyncio.run(board._answer(Attempt(session.draft.set(LEO, "5 parsec"), None)))
    assert "parsec" in beside.pop(LEO)
    assert len(beside) > 1 and set(beside.values()) == {""}
    asyncio.run(board._answer(Attempt(session.draft, 1)))
    assert beside[LEO] == ""


def test_a_slider_that_is_let_go_is_written_at_once_and_shown_behind_what_is_being_computed(
    session, board, monkeypatch
):
    done = []

    async def reload():
        done.append("reload")

    monkeypatch.setattr(board, "_reload", reload)
    monkeypatch.setattr(board, "_mark", lambda: done.append("mark"))

    async def let_go():
        board._busy = True
        task = asyncio.create_task(board._set(LEO, "6 cm"))
        for _ in range(5):
            await asyncio.sleep(0)
        before = session.draft.values[LEO].typed, list(done)
        board._busy = False
        await task
        return before

    assert asyncio.run(let_go()) == ("6 cm", [])
    assert done == ["mark", "reload"]


def test_all_controllers_that_are_tuned_twice_at_once_are_tuned_for_the_second_time_alone(
    session, controls, monkeypatch
):
    page = controls
    asyncio.run(page.reload())
    page.made.clear()
    gate = asyncio.Event()

    async def slow(element, work, *args):
        await gate.wait()
        return work(*args)

    monkeypatch.setattr(control, "in_thread", slow)

    async def twice():
        first = asyncio.create_task(page.tune_all())
        await asyncio.sleep(0)
        second = asyncio.create_task(page.tune_all())
        await asyncio.sleep(0)
        gate.set()
        await asyncio.gather(first, second)

    asyncio.run(twice())
    assert page.made == ["baseline", "baseline", "PI", "PID", "inverse"]
    assert (page.tune.visible, page.stop.visible) == (True, False)


def test_the_channels_of_a_recording_that_two_ask_for_at_once_are_read_once(bench, monkeypatch):
    listed, gate = [], asyncio.Event()
    put_in(bench, "a.csv", "b.csv")
    monkeypatch.setattr(mirror.reading, "list_channels", lambda path: listed.append(path.name) or CHANNELS)

    async def slow(element, work, *args):
        await gate.wait()
        return work(*args)

    monkeypatch.setattr(mirror, "in_thread", slow)

    async def three():
        tasks = [asyncio.create_task(bench._listing(key)) for key in ("a", "a", "b")]
        await asyncio.sleep(0)
        gate.set()
        return await asyncio.gather(*tasks)

    assert asyncio.run(three()) == [CHANNELS] * 3
    assert listed == ["a.csv", "b.csv"]


@pytest.mark.parametrize("back", [False, True], ids=["another mission", "the one that is shown"])
def test_names_of_a_mission_that_has_changed_again_are_dropped(session, controls, monkeypatch, back):
    gate = asyncio.Event()

    async def first_late(element, work, *args):
        if work is control._names and not gate.is_set():
            gate.set()
            for _ in range(20):
                await asyncio.sleep(0)
        return work(*args)

    async def changed_twice():
        older = asyncio.create_task(controls.reload())
        await gate.wait()
        session.set(LEO, typed)
        await controls.reload()
        await older

    asyncio.run(controls.reload())
    key, shown = controls.key, controls.file
    session.set(LEO, "6 cm")
    typed = "5 cm" if back else "7 cm"
    monkeypatch.setattr(control, "in_thread", first_late)
    asyncio.run(changed_twice())
    assert controls.key == session.key
    assert (controls.file == shown, controls.key == key) == (back, back)
    assert controls.file == session.mission()


def test_fits_of_the_identification_that_was_shown_before_are_not_those_of_another_one(session, job_view, monkeypatch):
    view, reads = job_view, asyncio.Event()
    view.jobs = [identified(session.folder, 2), identified(session.folder, 1)]
    view.read = {"1": fits("a1", "b1"), "2": fits("a2", "b2")}

    async def in_turn(element, work, *args):
        found = work(*args)
        if not reads.is_set():
            reads.set()
            while view.number == 1:
                await asyncio.sleep(0)
        else:
            for _ in range(20):
                await asyncio.sleep(0)
        return found

    async def chosen_meanwhile():
        timer = asyncio.create_task(view.look())
        await reads.wait()
        await view.follow(2)
        await timer

    asyncio.run(view.follow(1))
    monkeypatch.setattr(mirror_job, "in_thread", in_turn)
    asyncio.run(chosen_meanwhile())
    assert (view.number, [fit.model for fit in view.fits]) == (2, ["a2", "b2"])


def test_what_another_tab_accepts_no_longer_is_accepted_here_no_longer(bench):
    for accepted in (("drift", "dead"), ("dead",), ()):
        mirror_form.keep_form(bench.path, Form(Setting(accept=accepted)))
        asyncio.run(bench.look())
        assert (bench.form.setting.accept, bench.fields["accept"].value) == (accepted, list(accepted))


def test_headings_of_a_table_keep_their_units_and_names():
    columns = elements._columns(["loss\n(dB)", "rate in Mbit/s", "LQG"])
    assert [each["label"] for each in columns] == ["Loss (dB)", "Rate in Mbit/s", "LQG"]
