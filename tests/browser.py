"""Debian's Chromium and a running studio for the tests that look at pages, and a watch on what a page says and asks.

conftest.py takes the fixtures in. Chromium is started once for each file of tests, not for all of them: Playwright's
plain interface leaves an event loop running in its thread, in which no other test could call asyncio.run. A studio is
a process of its own and serves every file that does not ask for one for itself.
"""

import os
import re
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import pytest

import waiting
from shipped import SHIPPED, without_fine_pointing
from small_campaign import halting
from waiting import HANG_MS, HANG_S

MISSION = "leo-geo.toml"
WIDTHS = (400, 1000, 1400) if os.environ.get("MICRORAD_ENDURANCE") else (400, 1400)
"""On both sides of the widths at which pages of the studio change their columns: 700, 1000, 1150 and 1250."""
_SETTLED = """
() => new Promise(done => {
  let last = setTimeout(done, 250);
  new MutationObserver(() => { clearTimeout(last); last = setTimeout(done, 250); })
    .observe(document, { subtree: true, childList: true, attributes: true, characterData: true });
})
"""
_AXE = {"preload": False, "resultTypes": ["violations"]}  # requests of its own would be seen by the page


class Studio:
    """`microrad studio` in a folder of its own with the paper's mission, but for its fine-pointing loop.

    `url` has the token, `base` has not. A campaign halts behind its first chunk while the folder has a file `halt`.
    """

    def __init__(self, folder):
        pytest.importorskip("nicegui", reason="the studio is not installed (nicegui)")
        self.folder, self.file = folder, folder / MISSION
        self.file.write_text(without_fine_pointing(SHIPPED.read_text("utf-8")), "utf-8")
        self.process = subprocess.Popen(
            [sys.executable, "-m", "microrad", "studio", MISSION, "--no-browser"],
            cwd=folder,
            env={**os.environ, **halting(folder / "halt")},
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            start_new_session=True,
        )
        self.url = self.process.stdout.readline().strip()
        if not self.url:
            pytest.fail(f"the studio did not start: {self.process.communicate()[1]}")
        self.base = self.url.partition("?")[0]

    def enter(self, context, path=""):
        """A watched tab on one of the pages, which has shown the token."""
        if not context.pages:  # a tab that stays, with a refusal: without one each new tab compiles all scripts anew
            context.new_page().goto(f"{self.base}%07")
        page = watched(context.new_page())
        page.goto(self.url.replace(self.base, self.base + path))
        page.get_by_role("heading", level=1).wait_for()
        assert page.url == self.base + path
        return page

    def end(self):
        """End it as Ctrl-C does; it must have complained of nothing."""
        self.process.send_signal(signal.SIGINT)
        _, told = self.process.communicate(timeout=HANG_S)
        assert (self.process.returncode, told) == (0, "")


def watched(page):
    """The page, with what it complains of and what it asks for."""
    page.complaints, page.asked = [], []
    page.on("console", lambda m: page.complaints.append(m.text) if m.type in ("error", "warning") else None)
    page.on("pageerror", lambda error: page.complaints.append(str(error)))
    page.on("request", lambda request: page.asked.append(request.url))
    return page


def check_quiet(page, base):
    """The page has complained of nothing, and asked nobody but the studio at `base`."""
    assert page.complaints == []
    here = re.escape(base.removeprefix("http://"))
    own = re.compile(rf"(http|ws)://{here}|data:|blob:http://{here}")
    assert [url for url in page.asked if not own.match(url)] == []
    assert len(page.asked) > 5


def settled(page):
    """Wait until nothing is grey (behind a change), all plots are drawn, and nothing changes for a quarter second."""
    page.wait_for_function("!document.querySelector('.behind')")
    page.wait_for_function("[...document.querySelectorAll('.js-plotly-plot')].every(e => e.querySelector('.main-svg'))")
    page.evaluate(_SETTLED)


def violations(page):
    """What axe finds wrong in a page."""
    axe = pytest.importorskip("axe_playwright_python.sync_playwright", reason="axe is not installed")
    return axe.Axe().run(page, options=_AXE).response["violations"]


def fits(page, name, picture):
    """The page scrolls to no side at any of `WIDTHS`, and axe finds nothing serious; it has its width again behind it.

    What those who do not see are told is the same at all widths, and looked at in the widest.
    """
    before = page.viewport_size
    for width in WIDTHS:
        page.set_viewport_size({"width": width, "height": 900})
        settled(page)
        picture(page, f"{name}-{width}.png", full_page=True)
        page.wait_for_function("document.documentElement.scrollWidth <= document.documentElement.clientWidth")
        if width == max(WIDTHS) or os.environ.get("MICRORAD_ENDURANCE"):
            serious = [each for each in violations(page) if each["impact"] in ("serious", "critical")]
            assert [f"{each['id']}: {[node['html'][:150] for node in each['nodes']][:3]}" for each in serious] == []
    page.set_viewport_size(before)


def draft_is(page, words):
    """Wait until the page says of its mission that it is "saved", with all that was let go, or "not saved"."""
    page.get_by_role("status").get_by_text(words, exact=True).wait_for()


def until(page, there, what):
    """Wait until something holds on this side; the page goes on meanwhile."""
    return waiting.until(there, what, pause=lambda seconds: page.wait_for_timeout(1000.0 * seconds))


def new_context(browser, **options):
    """Tabs of their own, whose waits have the one limit."""
    found = browser.new_context(**options)
    found.set_default_timeout(HANG_MS)
    return found


@pytest.fixture(scope="module")
def browser():
    """Debian's Chromium, without a window."""
    api = pytest.importorskip("playwright.sync_api", reason="Playwright is not installed")
    program = shutil.which("chromium") or shutil.which("chromium-browser")
    if program is None:
        pytest.skip("Chromium is not installed")
    api.expect.set_options(timeout=HANG_MS)
    with api.sync_playwright() as play:
        # Few processes: a browser for one studio needs none of a renderer's own for each tab, nor one for the pictures.
        few = ["--in-process-gpu", "--process-per-site", "--renderer-process-limit=1"]
        found = play.chromium.launch(executable_path=program, args=["--no-sandbox", *few])
        yield found
        found.close()


@pytest.fixture(scope="module")
def context(browser):
    """Tabs that share the studio's cookie."""
    found = new_context(browser, viewport={"width": 1400, "height": 900})
    found.grant_permissions(["clipboard-read", "clipboard-write"])
    yield found
    found.close()


@pytest.fixture(scope="session")
def studio(tmp_path_factory):
    """A studio for many files: behind each test, its mission and the file are as they were."""
    found = Studio(tmp_path_factory.mktemp("studio"))
    yield found
    found.end()


@pytest.fixture
def opened(studio, context):
    """Opens tabs of the studio, by the path of a page; none of them may complain of anything or ask anybody else."""
    made = []

    def enter(path=""):
        made.append(studio.enter(context, path))
        return made[-1]

    yield enter
    for page in made:
        page.close()
    for page in made:
        check_quiet(page, studio.base)


@pytest.fixture
def tab(opened):
    """A tab of the studio, on its first page."""
    return opened()


@pytest.fixture(scope="session")
def picture():
    """Keeps a screenshot where MICRORAD_SCREENSHOTS names a folder, and takes none elsewhere."""
    named = os.environ.get("MICRORAD_SCREENSHOTS")

    def take(page, name, **options):
        if named:
            Path(named).mkdir(parents=True, exist_ok=True)
            page.screenshot(path=Path(named) / name, **options)

    return take
