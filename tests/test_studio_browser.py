"""The studio in a browser, as its user sees it: Debian's Chromium through Playwright, against the real command.

Screenshots go to the folder that MICRORAD_SCREENSHOTS names, else to a temporary one of pytest.
"""

import json
import os
import re
import shutil
import signal
import subprocess
import sys
import tomllib
from importlib import import_module
from pathlib import Path

import pytest

from microrad.studio import server
from microrad.studio.draft import Draft
from shipped import SHIPPED, without_fine_pointing

pytestmark = pytest.mark.long

pytest.importorskip("nicegui", reason="the studio is not installed (nicegui)")
api = pytest.importorskip("playwright.sync_api", reason="Playwright is not installed")

APERTURE = "terminals.leo_aperture"
WIDTHS = (1000, 1400)
LONG_MS = 240_000  # a study on a machine with other work to do


class Studio:
    """The command, running in a folder with a mission of the paper's without its fine-pointing loop."""

    def __init__(self, folder):
        self.folder, self.file = folder, folder / "leo-geo.toml"
        self.file.write_text(without_fine_pointing(SHIPPED.read_text("utf-8")), "utf-8")
        self.process = subprocess.Popen(
            [sys.executable, "-m", "microrad", "studio", "leo-geo.toml", "--no-browser"],
            cwd=folder,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            start_new_session=True,
        )
        self.url = self.process.stdout.readline().strip()
        if not self.url:
            pytest.fail(f"the studio did not start: {self.process.communicate()[1]}")
        self.base = self.url.partition("?")[0]

    def end(self):
        self.process.send_signal(signal.SIGINT)
        out, err = self.process.communicate(timeout=30)
        return self.process.returncode, out, err


@pytest.fixture(scope="module")
def studio(tmp_path_factory):
    found = Studio(tmp_path_factory.mktemp("studio"))
    yield found
    code, _, err = found.end()
    assert (code, err) == (0, "")


@pytest.fixture(scope="module")
def browser():
    program = shutil.which("chromium")
    if program is None:
        pytest.skip("Chromium is not installed")
    with api.sync_playwright() as play:
        found = play.chromium.launch(executable_path=program, args=["--no-sandbox"])
        yield found
        found.close()


@pytest.fixture(scope="module")
def pictures(tmp_path_factory):
    named = os.environ.get("MICRORAD_SCREENSHOTS")
    folder = Path(named) if named else tmp_path_factory.mktemp("screenshots")
    folder.mkdir(parents=True, exist_ok=True)
    return folder


@pytest.fixture(scope="module")
def context(browser):
    found = browser.new_context(viewport={"width": 1400, "height": 900})
    found.grant_permissions(["clipboard-read", "clipboard-write"])
    yield found
    found.close()


@pytest.fixture
def tab(studio, context):
    """A tab that has shown the token; it must complain of nothing and ask nobody else."""
    page = opened(context, studio)
    yield page
    for each in context.pages:
        each.close()
    assert page.complaints == []
    here = re.escape(studio.base.removeprefix("http://"))
    own = re.compile(rf"(http|ws)://{here}|data:|blob:http://{here}")
    assert [url for url in page.asked if not own.match(url)] == []
    assert len(page.asked) > 5


def opened(context, studio):
    page = context.new_page()
    page.complaints, page.asked = [], []
    page.on("console", lambda m: page.complaints.append(m.text) if m.type in ("error", "warning") else None)
    page.on("pageerror", lambda error: page.complaints.append(str(error)))
    page.on("request", lambda request: page.asked.append(request.url))
    page.goto(studio.url)
    assert page.url == studio.base
    page.get_by_role("heading", name="Mission", level=1).wait_for()
    return page


def show_table(page, name):
    page.locator(".mission-entry").filter(has_text=re.compile(rf"^{name}\d*$")).click()
    page.get_by_role("heading", name=f"[{name}]").first.wait_for()


def field(page, key):
    return page.locator(".mission-row").filter(has=page.get_by_text(key, exact=True))


# ------------------------------------------------------------------------------------------------------------ mission
def test_an_aperture_is_changed_checked_saved_and_budgeted_by_the_command_line(studio, tab, call, pictures):
    """The way of a mission: changed in the form, refused with the command line's words, corrected, saved, run."""
    show_table(tab, "terminals")
    row = field(tab, "leo_aperture")
    row.get_by_label("leo_aperture").fill("6 parsec")
    note = row.locator(".mission-note")
    note.get_by_text("no unit is called").wait_for()
    draft = Draft.open(studio.file).set(APERTURE, "6 parsec")
    (fault,) = draft.problems
    assert note.inner_text() == f"{fault.reason}; expected: {fault.expected}"
    tab.get_by_text("not saved, 1 fault to correct").wait_for()
    tab.screenshot(path=pictures / "mission-wrong-unit.png")
    row.get_by_label("leo_aperture").fill("6 cm")
    note.get_by_text("paper: Table 2").wait_for()
    assert "wrong" not in note.get_attribute("class")
    tab.get_by_text("No faults.").wait_for()
    before = studio.file.read_text("utf-8")
    tab.get_by_role("button", name="Save", exact=True).click()
    tab.get_by_role("status").get_by_text("saved", exact=True).wait_for()
    after = studio.file.read_text("utf-8")
    assert after == before.replace('leo_aperture = "5 cm"  ', 'leo_aperture = "6 cm"  ')
    assert after != before

    told = json.loads(call("budget", studio.file, "--json").out)
    margins = {link["name"]: link["margin_db"] for link in told["budgets"]}
    tab.get_by_role("link", name="Compare").click()
    tab.get_by_label("Compare with").click()
    tab.get_by_role("option", name="the paper's mission").click()
    tab.get_by_role("heading", name="Verdicts").wait_for()
    for name, margin in margins.items():
        shown = tab.get_by_role("row").filter(has_text=f"{name}: margin").get_by_role("cell").first.inner_text()
        assert shown.startswith(f"{margin:.2f} dB")
    assert "6 cm" in tab.get_by_role("row").filter(has_text=APERTURE).inner_text()
    assert "5 cm" in tab.get_by_role("row").filter(has_text=APERTURE).inner_text()
    tab.screenshot(path=pictures / "compare.png", full_page=True)


def test_the_text_and_the_form_follow_each_other(studio, tab):
    show_table(tab, "terminals")
    value = field(tab, "geo_aperture").get_by_label("geo_aperture")
    value.fill("21 cm")
    tab.locator(".cm-content").get_by_text('"21 cm"').wait_for()
    tab.locator(".cm-line").filter(has_text='"21 cm"').click()
    tab.keyboard.press("Home")
    tab.keyboard.press("Shift+End")
    tab.keyboard.type('geo_aperture = "22 cm"')
    tab.wait_for_function("document.querySelector('.mission-row:nth-of-type(2) input')?.value === '22 cm'")
    tab.get_by_role("button", name="Back to the saved file").click()
    tab.get_by_role("button", name="Lose the changes").click()
    tab.wait_for_function("document.querySelector('.mission-row:nth-of-type(2) input')?.value === '15 cm'")


def test_a_second_tab_and_a_reload_see_what_the_first_has_changed(studio, tab):
    second = opened(tab.context, studio)
    for page in (tab, second):
        show_table(page, "beacon")
    field(tab, "transmit_power").get_by_label("transmit_power").fill("3.5 W")
    second.wait_for_function("[...document.querySelectorAll('input')].some(e => e.value === '3.5 W')")
    second.reload()
    show_table(second, "beacon")
    assert field(second, "transmit_power").get_by_label("transmit_power").input_value() == "3.5 W"
    field(second, "transmit_power").get_by_label("transmit_power").fill("4 W")
    tab.wait_for_function("[...document.querySelectorAll('input')].every(e => e.value !== '3.5 W')")
    assert second.complaints == []


def test_a_table_is_added_from_its_example_and_saved_under_another_name(studio, tab, pictures):
    tab.get_by_role("button", name="Add a table").click()
    dialog = tab.get_by_role("dialog")
    dialog.get_by_label("Table").click()
    tab.get_by_role("option", name="[channel]").click()
    dialog.get_by_role("button", name="Add", exact=True).click()
    tab.get_by_role("heading", name="[channel]").wait_for()
    tab.get_by_role("button", name="Save as").click()
    dialog = tab.get_by_role("dialog")
    dialog.get_by_label("Name of the file").fill("../outside.toml")
    dialog.get_by_role("button", name="Save", exact=True).click()
    dialog.get_by_text("its name holds a path; choose another name").wait_for()
    tab.screenshot(path=pictures / "save-as.png")
    dialog.get_by_label("Name of the file").fill("with-channel")
    dialog.get_by_role("button", name="Save", exact=True).click()
    dialog.wait_for(state="hidden")
    saved = tomllib.loads((studio.folder / "with-channel.toml").read_text("utf-8"))
    assert saved["channel"] == {"zenith_transmission": 0.9, "elevation": "30 deg"}
    assert not (studio.folder.parent / "outside.toml").exists()
    tab.get_by_role("button", name="Open ...").click()
    dialog = tab.get_by_role("dialog")
    dialog.get_by_label("File").click()
    tab.get_by_role("option", name="leo-geo.toml").click()
    dialog.get_by_role("button", name="Open", exact=True).click()
    tab.locator(".mission-entry").filter(has_text="channel").wait_for(state="detached")
    (studio.folder / "with-channel.toml").unlink()


def test_html_in_a_missions_name_is_text(studio, tab):
    show_table(tab, "beacon")
    tab.locator(".mission-entry").filter(has_text="general").click()
    name = "<img src=x onerror='window.slipped=1'>"
    field(tab, "name").get_by_label("name").fill(name)
    tab.locator(".cm-content").get_by_text("onerror").wait_for()
    for path in ("compare", "runs", ""):
        tab.goto(studio.base + path)
        tab.get_by_role("heading", level=1).wait_for()
    assert tab.locator("img[src=x]").count() == 0
    assert tab.evaluate("window.slipped") is None
    tab.get_by_role("button", name="Back to the saved file").click()
    tab.get_by_role("button", name="Lose the changes").click()
    tab.locator(".cm-content").get_by_text("onerror").wait_for(state="detached")


def test_what_is_done_can_be_copied_as_a_command_and_as_python(studio, tab):
    tab.get_by_role("button", name="Copy as command").click()
    tab.get_by_text("Copied: microrad budget leo-geo.toml").wait_for()
    assert tab.evaluate("navigator.clipboard.readText()") == "microrad budget leo-geo.toml"
    tab.get_by_role("button", name="Copy as Python").click()
    tab.get_by_text("Copied: from microrad import").wait_for()
    lines = tab.evaluate("navigator.clipboard.readText()")
    ran = subprocess.run([sys.executable, "-c", lines], cwd=studio.folder, capture_output=True, text=True, check=True)
    assert "margin" in ran.stdout


# --------------------------------------------------------------------------------------------------------------- runs
def job(page, number):
    return page.get_by_role("article").filter(has=page.get_by_role("heading", name=re.compile(rf"^{number}\.")))


def test_a_study_is_cancelled_in_mid_run_from_another_tab_after_a_reload(studio, tab, pictures):
    tab.get_by_role("link", name="Runs").click()
    tab.get_by_role("button", name="Run the study").click()
    running = job(tab, 1)
    running.get_by_text("running", exact=True).wait_for()
    running.get_by_text(re.compile(r"\d+ %, \d+ of \d+: ")).wait_for(timeout=LONG_MS)
    tab.screenshot(path=pictures / "runs-running.png")
    tab.reload()
    running.get_by_text(re.compile(r"\d+ %, \d+ of \d+: ")).wait_for()
    second = opened(tab.context, studio)
    second.get_by_role("link", name="Runs").click()
    job(second, 1).get_by_role("button", name="Cancel").click()
    running.get_by_text("cancelled").wait_for()
    job(second, 1).get_by_text("cancelled").wait_for()
    assert not (studio.folder / "leo-geo-study").exists()
    job(second, 1).get_by_role("button", name="Remove from the list").click()
    job(tab, 1).wait_for(state="detached")
    assert second.complaints == []


def test_a_study_ends_with_its_verdict_and_a_report_in_the_page(studio, tab, pictures):
    tab.get_by_role("link", name="Runs").click()
    api.expect(tab.get_by_label("Folder for the results")).to_have_value(re.compile("leo-geo-study"))
    tab.get_by_label("Folder for the results").fill("found")
    tab.get_by_role("button", name="Run the study").click()
    done = tab.get_by_role("article").filter(has_text="--output found")
    done.get_by_text("done: the link").wait_for(timeout=LONG_MS)
    summary = json.loads((studio.folder / "found" / "manifest.json").read_text("utf-8"))["summary"]
    api.expect(done.locator(".runs-said")).to_contain_text(summary["verdict"])
    assert done.get_by_text("done: the link closes").count() == summary["closes"]
    done.get_by_role("button", name="Show report.html here").click()
    report = tab.frame_locator("iframe")
    report.get_by_role("heading", level=1).wait_for()
    tab.screenshot(path=pictures / "runs-report.png")
    policy = "fetch(document.querySelector('iframe').src).then(r => r.headers.get('content-security-policy'))"
    assert tab.evaluate(policy).startswith("sandbox ")
    with tab.expect_download() as download:
        done.get_by_role("link", name="Save found/manifest.json").click()
    assert json.loads(Path(download.value.path()).read_text("utf-8"))["summary"] == summary


# ---------------------------------------------------------------------------------------------------------- each page
@pytest.mark.parametrize("width", WIDTHS)
@pytest.mark.parametrize("name", server.PAGES)
def test_each_page_fits_and_has_no_serious_fault_for_those_who_do_not_see_it(studio, tab, pictures, name, width):
    axe = pytest.importorskip("axe_playwright_python.sync_playwright", reason="axe is not installed")
    module = import_module(f"microrad.studio.pages.{name}")
    tab.set_viewport_size({"width": width, "height": 900})
    tab.goto(studio.base + module.PATH.removeprefix("/"))
    tab.get_by_role("heading", name=module.TITLE, level=1).wait_for()
    tab.wait_for_timeout(1500)
    tab.screenshot(path=pictures / f"{name}-{width}.png")
    assert tab.evaluate("document.documentElement.scrollWidth - document.documentElement.clientWidth") <= 0
    found = axe.Axe().run(tab).response["violations"]
    serious = [each for each in found if each["impact"] in ("serious", "critical")]
    assert [f"{each['id']}: {[node['html'][:150] for node in each['nodes']][:3]}" for each in serious] == []
