"""Pages that are closed while they wait for something: what was to come is dropped, and nobody complains."""

import ast
import asyncio
import base64
import importlib
import threading
from dataclasses import replace
from functools import cache
from itertools import cycle
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from budget_files import TABLE
from microrad.report.plotting.figure import Figure as Reported
from microrad.report.plotting.sheet import Line, grid
from microrad.report.tables import Cell, Table
from microrad.report.view import Drawing, Points, Soft, Verbatim, Verdict, View
from microrad.studio.jobs.files import EXIT, STARTED, STDOUT, note
from microrad.studio.jobs.queue import JobError
from microrad.studio.recordings import reading
from microrad.studio.recordings.uploads import Uploads
from microrad.studio.session import Session
from microrad.studio.views import compare as compare_view
from microrad.studio.views import errors, latest, plots
from shipped import SHIPPED
from studio_jobs import written

pytest.importorskip("nicegui", reason="the studio is not installed (nicegui)")

from nicegui import background_tasks, client, core, ui
from nicegui.app.app import State
from nicegui.client import Client
from nicegui.outbox import Outbox
from nicegui.page import page as at

from microrad.studio import pages
from microrad.studio.pages import elements, in_thread, link, mirror, runs
from waiting import HANG_S

FOLDER = Path(pages.__file__).parent


class Answer:
    """What a browser answers, if anybody waits for it."""

    def __init__(self, come):
        self.come = come

    def __await__(self):
        return self.come().__await__()


async def _nothing(*_):
    pass


class Visit:
    """A tab without a browser, which is closed as its page waits for the time that `leave` tells; 0 for never.

    `told` is what NiceGUI complains of then; `waits` is how often the page has waited.
    """

    def __init__(self, patch, leave=0):
        self.patch, self.leave = patch, leave
        self.waits, self.told, self.looks = 0, [], []
        patch.setattr(core, "loop", asyncio.get_running_loop())
        patch.setattr(client.helpers, "warn_once", lambda words, **more: self.told.append(words))
        patch.setattr(core.app, "handle_exception", lambda error: self.told.append(repr(error)))
        patch.setattr(in_thread.run, "io_bound", self._wait)
        patch.setattr(ui, "timer", self._timer)
        patch.setattr(Outbox, "loop", _nothing)
        patch.setattr(Client, "run_javascript", lambda *code, **more: Answer(self._closed_in_turn))
        self.tab = Client(at("/"), request=None)

    def _timer(self, interval, look, **how):
        self.looks.append(look)
        return SimpleNamespace(active=True)

    async def _wait(self, work, *args, **kwargs):
        """In place of waiting for a thread; as there, a handler goes on behind it although its page is gone."""
        await self._closed_in_turn()
        return work(*args, **kwargs)

    async def _closed_in_turn(self):
        self.waits += 1
        if self.waits == self.leave:
            self.tab.delete()
        await asyncio.sleep(0)

    async def over(self, *handlers):
        """Run handlers as events of the page do, and what they have begun."""
        for handler in handlers:
            if self.tab.is_deleted:
                break
            background_tasks.create(self._handled(handler))
            await self.rest()

    async def _handled(self, handler):
        with self.tab:
            found = handler()
            if asyncio.iscoroutine(found):
                await found

    async def rest(self):
        """Have everything end that was begun."""
        while background_tasks.running_tasks:
            await asyncio.wait(background_tasks.running_tasks)

    def end(self):
        """Close the tab, unless it is closed."""
        if not self.tab.is_deleted:
            self.tab.delete()


@pytest.fixture(scope="module")
def session(tmp_path_factory):
    """A folder with a mission and its budget of errors, a campaign, a recording, ended jobs; its day is computed."""
    folder = tmp_path_factory.mktemp("folder")
    (folder / "leo-geo.toml").write_text(SHIPPED.read_text("utf-8") + TABLE, "utf-8")
    found = Session(folder)
    found.other = found.draft
    runs.write_campaign(found)
    for number, kind in enumerate(("identification", "campaign", "study"), 1):
        job = written(found.studio / "jobs", number, kind=kind)
        note(job / STARTED, pid=1)
        (job / STDOUT).write_text("said\n", "utf-8")
        note(job / EXIT, code=0)
    time = np.arange(400) / 200
    drive = 50 - 50 * np.cos(2 * np.pi * time)
    rows = np.column_stack([time, drive, 10 * drive])
    text = "Time (s),Drive (V),Angle (urad)\n" + "".join(f"{t:.3f},{v:.4f},{a:.4f}\n" for t, v, a in rows)

    async def blocks():
        yield text.encode()

    asyncio.run(Uploads(found.studio / "uploads").save("loop.csv", blocks()))
    return found


@pytest.fixture(scope="module")
def budget_seen(session):
    """What the page of pointing shows of the mission's budget of errors."""
    file = session.draft.link()
    return errors.view(file, file.mission.error_budget)


@pytest.fixture
def read_once(monkeypatch):
    """A recording is read by one process, not by one for each visit."""
    for name in ("list_channels", "view"):
        monkeypatch.setattr(reading, name, cache(getattr(reading, name)))


def left(patch, session, build, leave):
    """A visit of what `build` puts on a page, closed as it waits for this time."""

    async def go():
        visit = Visit(patch, leave)
        with visit.tab:
            handlers = build(session, visit)
        await visit.over(*handlers)
        for question in latest._shared.get(session, {}).values():
            question.wait(HANG_S)
        await visit.over(*handlers)
        visit.end()
        return visit

    return asyncio.run(go())


def every_time(session, build):
    """How often a page waits, closed in turn as it waits for each time; what is complained of, by the time."""
    told, leave = {}, 0
    while True:
        with pytest.MonkeyPatch.context() as patch:
            visit = left(patch, session, build, leave)
        if visit.told:
            told[leave] = visit.told
        if leave and visit.waits < leave:
            return leave - 1, told
        leave += 1


WAITS = {"compare": 2, "control": 4, "day": 2, "link": 3, "mirror": 4, "mission": 0, "pointing": 5, "runs": 17}


@pytest.mark.parametrize(
    "name", [pytest.param(n, marks=[pytest.mark.endurance] if n in ("compare", "day") else []) for n in WAITS]
)
def test_a_page_may_be_closed_whenever_it_waits(session, name, monkeypatch, read_once, budget_seen):
    monkeypatch.setattr(link, "_REST_S", -1.0)  # asks for the study of the links at once
    monkeypatch.setattr(compare_view, "link_numbers", lambda draft: ())  # takes a second of each visit
    monkeypatch.setattr(errors, "view", lambda file, table: budget_seen)  # as this does
    module = importlib.import_module(f"microrad.studio.pages.{name}")

    def build(session, visit):
        module.page(session)
        return visit.looks

    assert every_time(session, build) == (WAITS[name], {})


def test_every_page_is_closed_here():
    parsed = {path.stem: ast.parse(path.read_text("utf-8")).body for path in FOLDER.glob("*.py")}
    assert set(WAITS) == {name for name, body in parsed.items() if "page" in {getattr(e, "name", "") for e in body}}


def dropped(session, visit):
    page = mirror.MirrorPage(session)
    recording = page.uploads.listed()[0]

    async def stored(request):
        return [recording]

    page.drop._stored = stored
    return [lambda: page.drop._take(None), page.start]


def started(session, visit):
    """A study that may be queued, and one that may not."""
    study = runs._Study(session)
    study.folder.value = "found"
    answers = cycle([None, JobError("the disk is full")])

    def submit(order):
        answer = next(answers)
        if answer is not None:
            raise answer

    visit.patch.setattr(session.jobs, "submit", submit)
    return [study._run, study._run]


def told_of(session, visit):
    """A campaign's example that is refused, as there is one."""
    return [runs._Campaign(session)._example]


@pytest.mark.parametrize("build", [dropped, started, told_of])
def test_a_page_may_be_closed_while_what_was_clicked_is_done(session, build, read_once):
    times, told = every_time(session, build)
    assert (times >= 2, told) == (True, {})


def test_a_file_that_comes_after_its_page_was_closed_is_answered(session, monkeypatch):
    """The browser may be another tab's; its request is answered whether its page is there or not."""

    async def send():
        visit = Visit(monkeypatch, leave=1)
        with visit.tab:
            page = mirror.MirrorPage(session)
        recording = page.uploads.listed()[0]
        page.drop._stored = lambda request: asyncio.sleep(0, [recording])
        return visit, (await page.drop._take(None)).body

    visit, answer = asyncio.run(send())
    assert (visit.tab.is_deleted, visit.told, answer) == (True, [], b"read")


def test_a_file_that_is_no_recording_is_thrown_away_although_its_page_is_closed(tmp_path, monkeypatch):
    uploads = Uploads(tmp_path / "uploads")

    async def blocks():
        yield b"this is no recording"

    async def send(leave):
        visit = Visit(monkeypatch, leave)
        with visit.tab:
            page = mirror.MirrorPage(SimpleNamespace(studio=tmp_path, folder=tmp_path, jobs=None))
        upload = await uploads.save("junk.csv", blocks())
        page.drop._stored = lambda request: asyncio.sleep(0, [upload])
        await page.drop._take(None)
        visit.end()
        return page.refused.text

    assert "junk.csv" in asyncio.run(send(leave=0))
    assert asyncio.run(send(leave=1)) == ""
    assert uploads.listed() == ()


def test_a_handler_that_is_cancelled_ends():
    """NiceGUI's own wait takes that for an answer."""
    begun, released = threading.Event(), threading.Event()

    def work():
        begun.set()
        released.wait(HANG_S)

    async def cancelled():
        task = asyncio.create_task(in_thread.in_thread(SimpleNamespace(is_deleted=False), work))
        assert await asyncio.to_thread(begun.wait, HANG_S)
        task.cancel()
        await asyncio.wait([task])
        released.set()
        return task.cancelled()

    assert asyncio.run(cancelled())


def test_what_is_done_in_a_thread_is_answered_or_ends_whoever_asked(monkeypatch):
    def refuse():
        raise ValueError("a reason")

    async def ask(work, leave):
        visit = Visit(monkeypatch, leave)
        with visit.tab:
            label = ui.label()
        try:
            return await in_thread.in_thread(label, work)
        except (ValueError, asyncio.CancelledError) as error:
            return type(error), str(error)
        finally:
            visit.end()

    assert asyncio.run(ask(lambda: 7, leave=0)) == 7
    assert asyncio.run(ask(refuse, leave=0)) == (ValueError, "a reason")
    assert asyncio.run(ask(lambda: 7, leave=1)) == (asyncio.CancelledError, "")
    assert asyncio.run(ask(refuse, leave=1)) == (asyncio.CancelledError, "")
    monkeypatch.setattr(core.app, "_state", State.STOPPING)
    assert asyncio.run(ask(lambda: 7, leave=0)) == (asyncio.CancelledError, "")


def test_pages_wait_by_the_one_way_that_ends_with_them():
    others = {"io_bound", "cpu_bound", "to_thread", "run_in_executor", "sleep"}
    found = {
        (path.name, node.attr)
        for path in FOLDER.glob("*.py")
        for node in ast.walk(ast.parse(path.read_text("utf-8")))
        if isinstance(node, ast.Attribute) and node.attr in others
    }
    assert found == {("in_thread.py", "io_bound"), ("in_thread.py", "sleep")}


@pytest.mark.promise("studio-13")
def test_blocks_of_the_report_are_shown_as_text_and_what_was_unfolded_stays_so(monkeypatch):
    """Every kind of block; a name in one is never markup."""
    at, svg = np.array([0.0, 1.0]), "<svg xmlns='http://www.w3.org/2000/svg'/>"
    sheet, (panel,) = grid(4.0, 3.0)
    panel.add(Line(at, at))
    moving = Reported("moving", "Moving", "of moving", sheet, {})
    still = replace(moving, name="still").static
    rows = Table("Rows", ("name", "value"), [(Cell("<b>", "!"), "1"), ("sum", "1")], totals=1)
    blocks = (
        "said",
        Soft("soft"),
        Points(["one", "two"]),
        Verbatim("as it\n  is"),
        Verdict("good", [replace(rows, title="", folded="Folded rows")], good=True),
        rows,
        View("Part", [moving, still, View("Inner", [Drawing("d", "Drawing", "of it", svg)], folded=True)]),
    )

    async def shown():
        visit = Visit(monkeypatch)
        with visit.tab:
            box = elements.Blocks()
            box.show_blocks(blocks, plots.drawn(blocks))
            folds = {fold.text: fold for fold in box.descendants() if isinstance(fold, ui.expansion)}
            assert [(name, fold.value) for name, fold in folds.items()] == [("Folded rows", False), ("Inner", False)]
            folds["Inner"].value = True
            kept = [*box.descendants()]
            box.show_blocks(("said first", *blocks[1:]), plots.drawn(blocks))
            assert [each for each in box.descendants() if each.tag != "li"] == [
                each for each in kept if each.tag != "li"
            ]
            assert kept[0].text == "said first"
            box.show_blocks((*blocks, "more"), plots.drawn(blocks))
            assert kept[0].is_deleted
            folds = {fold.text: fold for fold in box.descendants() if isinstance(fold, ui.expansion)}
            folds["Inner"].value = True
            box.show_blocks((*blocks, "other"), plots.drawn(blocks))
            found = [*box.descendants()]
        visit.end()
        return found, visit.told

    found, told = asyncio.run(shown())
    texts = [each.text for each in found if hasattr(each, "text")]
    assert told == []
    assert {
        "said",
        "soft",
        "one",
        "two",
        "as it\n  is",
        "good",
        "Rows",
        "Part",
        "Moving. of moving",
        "Drawing. of it",
    } <= {*texts}
    assert [each.value for each in found if isinstance(each, ui.expansion)] == [False, True]
    tables = [each.rows for each in found if isinstance(each, ui.table)]
    assert [row["c0"] for row in tables[1]] == ["<b> !", "sum"]
    assert [row["total"] for row in tables[1]] == [False, True]
    (drawn,) = (each for each in found if isinstance(each, elements.Figure))
    assert drawn.props["begin"]["data"][0]["x"] == [0, 1]
    pictures = [each.props["src"].partition(",") for each in found if each.tag == "img"]
    assert {kind for kind, *_ in pictures} == {"data:image/svg+xml;base64"}
    assert [base64.b64decode(data).decode()[:5] for *_, data in pictures] == ["<svg "] * 2
