"""The studio in a browser, as its user sees it: Debian's Chromium through Playwright, against the real command."""

import json
import os
import re
import signal
import tomllib
from importlib import import_module
from pathlib import Path

import pytest

from browser import Studio, draft_is, fits, until
from microrad.campaign.statistics.interim import Interim
from microrad.campaign.statistics.summary import summarise_campaign
from microrad.report.campaign import words as campaign_words
from microrad.studio import commands, server
from microrad.studio.draft.draft import Draft
from shipped import without_day
from small_campaign import campaign_file, children, halted

api = pytest.importorskip("playwright.sync_api", reason="Playwright is not installed")

APERTURE = "terminals.leo_aperture"
OFTEN = bool(os.environ.get("MICRORAD_ENDURANCE"))
LATE = {
    "mission": "[aria-label='Text of the mission']",
    "link": "text=every requirement is met",
    "pointing": "text=with a probability of",
    "day": "text=In 24 h the relay is in view",
}
"""What pages have last, where it takes a while."""


@pytest.fixture(scope="module")
def studio(tmp_path_factory):
    """A studio of its own, since here missions are saved and jobs counted."""
    found = Studio(tmp_path_factory.mktemp("studio"))
    yield found
    found.end()


def show_table(page, name):
    page.locator(".mission-entry").filter(has_text=re.compile(rf"^{name}\d*$")).click()
    page.get_by_role("heading", name=f"[{name}]").first.wait_for()


def opened_again(studio, tab, text):
    """Another program writes the mission, and the page opens it again."""
    studio.file.write_text(text, "utf-8")
    tab.get_by_role("status").get_by_text("changed on disk; open it again", exact=True).wait_for()
    tab.get_by_role("button", name="Back to the saved file").click()
    tab.get_by_role("button", name="Open again").click()
    draft_is(tab, "saved")


def field(page, key):
    return page.locator(".mission-row").filter(has=page.get_by_text(key, exact=True))


# ------------------------------------------------------------------------------------------------------------ mission
@pytest.mark.promise("studio-1", "studio-12")
def test_an_aperture_is_changed_checked_saved_and_budgeted_by_the_command_line(studio, tab, call, picture):
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
    picture(tab, "mission-wrong-unit.png")
    row.get_by_label("leo_aperture").fill("6 cm")
    note.get_by_text("paper: Table 2").wait_for()
    assert "wrong" not in note.get_attribute("class")
    tab.get_by_text("No faults.").wait_for()
    before = studio.file.read_text("utf-8")
    tab.get_by_role("button", name="Save", exact=True).click()
    draft_is(tab, "saved")
    after = studio.file.read_text("utf-8")
    assert after == before.replace('leo_aperture = "5 cm"  ', 'leo_aperture = "6 cm"  ')
    assert after != before

    told = json.loads(call("budget", studio.file, "--json").out)
    margins = {link["name"]: link["margin_db"] for link in told["budgets"]}
    tab.get_by_role("link", name="Compare").click()
    tab.get_by_label("Compare with").click()
    tab.get_by_role("option", name="the shipped mission").click()
    tab.get_by_role("heading", name="Verdicts").wait_for()
    for name, margin in margins.items():
        shown = tab.get_by_role("row").filter(has_text=f"{name}: margin").get_by_role("cell").nth(1)
        text = shown.inner_text()
        assert text.startswith(f"{margin:.2f} dB")
        assert (text.rpartition(" ")[2] in shown.get_attribute("class").split()) == ("required" in text)  # its colour
    assert "6 cm" in tab.get_by_role("row").filter(has_text=APERTURE).inner_text()
    assert "5 cm" in tab.get_by_role("row").filter(has_text=APERTURE).inner_text()
    assert tab.get_by_role("columnheader", name="the shipped mission").count() == 2  # though both are leo-geo.toml
    tab.get_by_role("button", name="Copy as command").last.click()
    tab.get_by_text("the shipped mission is not a file of this folder yet; save it there first.").wait_for()
    tab.reload()
    tab.get_by_role("heading", name="Verdicts").wait_for()
    assert tab.get_by_label("Compare with").input_value() == "the shipped mission"
    picture(tab, "compare.png", full_page=True)
    fits(tab, "compare", picture)


@pytest.mark.promise("studio-12")
def test_the_text_and_the_form_follow_each_other(studio, tab, picture):
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
    fits(tab, "mission", picture)


@pytest.mark.endurance  # test_studio_mission_page.py has it without a browser
def test_a_file_that_another_program_changes_is_told_and_opened_again(studio, tab):
    before = studio.file.read_text("utf-8")
    show_table(tab, "terminals")
    for size, text in (("17 cm", before.replace('"15 cm"', '"17 cm"', 1)), ("15 cm", before)):
        opened_again(studio, tab, text)
        api.expect(tab.get_by_label("geo_aperture")).to_have_value(size)


@pytest.mark.promise("studio-20")
def test_a_text_too_long_for_a_message_is_not_pasted(tab):
    text = tab.locator(".cm-content")
    text.click()
    tab.keyboard.press("Control+Home")
    paste = """length => {
      const given = new DataTransfer();
      given.setData("text/plain", "#".repeat(length));
      const event = new ClipboardEvent("paste", { clipboardData: given, bubbles: true, cancelable: true });
      document.querySelector(".cm-content").dispatchEvent(event);
    }"""
    tab.evaluate(paste, 500_001)
    tab.get_by_text("more than 500000 characters and is no mission: it was not put in").wait_for()
    assert "##" not in text.inner_text()
    tab.evaluate(paste, 12)
    text.get_by_text("#" * 12).wait_for()
    tab.get_by_role("button", name="Back to the saved file").click()
    tab.get_by_role("button", name="Lose the changes").click()
    text.get_by_text("#" * 12).wait_for(state="detached")


@pytest.mark.endurance  # test_studio_server.py has two tabs without a browser
def test_a_second_tab_and_a_reload_see_what_the_first_has_changed(tab, opened):
    second = opened()
    for page in (tab, second):
        show_table(page, "beacon")
    field(tab, "transmit_power").get_by_label("transmit_power").fill("3.5 W")
    second.wait_for_function("[...document.querySelectorAll('input')].some(e => e.value === '3.5 W')")
    second.reload()
    show_table(second, "beacon")
    assert field(second, "transmit_power").get_by_label("transmit_power").input_value() == "3.5 W"
    field(second, "transmit_power").get_by_label("transmit_power").fill("4 W")
    tab.wait_for_function("[...document.querySelectorAll('input')].every(e => e.value !== '3.5 W')")


def test_a_table_is_added_from_its_example_and_saved_under_another_name(studio, tab, picture):
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
    picture(tab, "save-as.png")
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
    tab.locator(".cm-content").click()
    tab.keyboard.press("Control+z")  # not into the mission before
    tab.keyboard.type("#")
    tab.get_by_role("status").get_by_text("not saved").wait_for()
    kept = json.loads((studio.folder / ".microrad-studio" / "draft.json").read_text("utf-8"))
    assert "channel" not in re.findall(r"^\[(\w+)", kept["text"], re.MULTILINE)
    tab.get_by_role("button", name="Back to the saved file").click()
    tab.get_by_role("button", name="Lose the changes").click()
    draft_is(tab, "saved")
    (studio.folder / "with-channel.toml").unlink()


def test_html_in_a_missions_name_is_text(studio, tab):
    show_table(tab, "beacon")
    tab.locator(".mission-entry").filter(has_text="general").click()
    name = "<img src=x onerror='window.slipped=1'>"
    field(tab, "name").get_by_label("name").fill(name)
    tab.locator(".cm-content").get_by_text("onerror").wait_for()
    for path in ("compare", *(["runs"] if OFTEN else []), ""):
        tab.goto(studio.base + path)
        tab.get_by_role("heading", level=1).wait_for()
    assert tab.locator("img[src=x]").count() == 0
    assert tab.evaluate("window.slipped") is None
    tab.get_by_role("button", name="Back to the saved file").click()
    tab.get_by_role("button", name="Lose the changes").click()
    tab.locator(".cm-content").get_by_text("onerror").wait_for(state="detached")


@pytest.mark.promise("readme-15")
@pytest.mark.promise("studio-14")
def test_what_is_done_can_be_copied_as_a_command_and_as_python(studio, tab):
    tab.get_by_role("button", name="Copy as command").click()
    tab.get_by_text("Copied: microrad budget leo-geo.toml").wait_for()
    assert tab.evaluate("navigator.clipboard.readText()") == "microrad budget leo-geo.toml"
    tab.get_by_role("button", name="Copy as Python").click()
    tab.get_by_text("Copied: from microrad").wait_for()
    lines = tab.evaluate("navigator.clipboard.readText()")
    assert lines == commands.budget(Path("leo-geo.toml")).python  # which test_studio_commands.py runs


def test_copied_is_said_once_the_browser_has_copied_and_a_refusal_as_one(tab):
    held = "navigator.clipboard.writeText = () => new Promise((done, failed) => { window.told = { done, failed }; })"
    tab.evaluate(f"() => {{ {held}; }}")
    tab.get_by_role("button", name="Copy as command").click()
    tab.wait_for_function("window.told")
    assert not tab.get_by_text("Copied: ").count()
    tab.evaluate("told.done()")
    tab.get_by_text("Copied: microrad budget leo-geo.toml").wait_for()
    tab.evaluate("told = undefined")
    tab.get_by_role("button", name="Copy as command").click()
    tab.wait_for_function("window.told")
    tab.evaluate("told.failed(new Error('the user said no'))")
    tab.get_by_text("Not copied, the user said no: microrad budget leo-geo.toml").wait_for()


# --------------------------------------------------------------------------------------------------------------- runs
def job(page, number):
    return page.get_by_role("article").filter(has=page.get_by_role("heading", name=re.compile(rf"^{number}\.")))


@pytest.mark.promise("studio-17")
@pytest.mark.endurance  # test_studio_jobs.py cancels jobs without a browser
def test_a_study_is_cancelled_in_mid_run_from_another_tab_after_a_reload(studio, tab, opened, picture):
    tab.get_by_role("link", name="Runs").click()
    tab.get_by_role("button", name="Run the study").click()
    running = job(tab, 1)
    running.get_by_text("running", exact=True).wait_for()
    running.get_by_text(re.compile(r"\d+ %, \d+ of \d+: ")).wait_for()
    picture(tab, "runs-running.png")
    tab.reload()
    running.get_by_text(re.compile(r"\d+ %, \d+ of \d+: ")).wait_for()
    second = opened("runs")
    job(second, 1).get_by_role("button", name="Cancel").click()
    running.get_by_text("cancelled").wait_for()
    job(second, 1).get_by_text("cancelled").wait_for()
    assert [path.name for path in studio.folder.iterdir() if "leo-geo-study" in path.name] == []
    job(second, 1).get_by_role("button", name="Remove from the list").click()
    job(tab, 1).wait_for(state="detached")


@pytest.mark.promise("studio-12")
def test_a_study_ends_with_its_verdict_and_a_report_in_the_page(studio, tab, picture):
    """Of the mission without its day, of which it knows nothing before another program leaves it out."""
    whole = studio.file.read_text("utf-8")
    opened_again(studio, tab, without_day(whole))
    tab.get_by_role("link", name="Runs").click()
    api.expect(tab.get_by_label("Folder for the results")).to_have_value(re.compile("leo-geo-study"))
    tab.get_by_label("Folder for the results").fill("found")
    tab.get_by_role("button", name="Run the study").click()
    done = tab.get_by_role("article").filter(has_text="--output found")
    done.get_by_text(re.compile("^done: ")).wait_for()
    summary = json.loads((studio.folder / "found" / "manifest.json").read_text("utf-8"))["summary"]
    api.expect(done.locator(".runs-said")).to_contain_text(summary["verdict"])
    assert done.get_by_text("done: every requirement is met").count() == summary["met"]
    done.get_by_role("button", name="Show report.html here").click()
    report = tab.frame_locator("iframe")
    report.get_by_role("heading", level=1).wait_for()
    picture(tab, "runs-report.png")
    policy = "fetch(document.querySelector('iframe').src).then(r => r.headers.get('content-security-policy'))"
    assert tab.evaluate(policy).startswith("sandbox ")
    with tab.expect_download() as download:
        done.get_by_role("link", name="Save found/manifest.json").click()
    assert json.loads(Path(download.value.path()).read_text("utf-8"))["summary"] == summary
    fits(tab, "runs", picture)
    tab.get_by_role("link", name="Mission").click()
    opened_again(studio, tab, whole)


def held_up(studio, tab, number):
    """A job's command, which has halted behind its first chunk."""
    started = studio.folder / ".microrad-studio" / "jobs" / str(number) / "started.json"
    until(tab, started.is_file, "the job's start")
    (command,) = until(tab, lambda: children(json.loads(started.read_text("utf-8"))["pid"]), "the job's command")
    halted(command, pause=lambda seconds: tab.wait_for_timeout(1000.0 * seconds))
    return command


def rows_in(ledger):
    return sum(cell.rows for cell in Interim(ledger).look().cells)


def begun(studio, tab, rows):
    """A campaign that has halted behind its first chunk: its card, the number of its job, its command."""
    campaign_file(studio.folder, runs=rows)
    (studio.folder / "halt").touch()
    tab.get_by_role("link", name="Runs").click()
    api.expect(tab.get_by_label("Ledger")).to_have_value("campaign.ledger")
    tab.get_by_role("button", name="Run the campaign").click()
    card = tab.get_by_role("article").filter(has_text="campaign run campaign.toml").first
    number = int(card.get_by_role("heading").first.inner_text().partition(".")[0])
    command = held_up(studio, tab, number)
    card.get_by_text(re.compile(rf"\d+ %, \d+ of {rows} rows")).wait_for()
    return card, number, command


@pytest.mark.endurance  # test_studio_campaign_live.py and test_studio_pages.py have it without a browser
def test_a_campaign_shows_its_figures_while_it_runs_in_every_tab_and_has_its_report(studio, tab, opened, picture):
    rows, ledger = 384, studio.folder / "campaign.ledger"  # in two chunks
    first, number, command = begun(studio, tab, rows)
    second = opened("runs")
    done = rows_in(ledger)
    assert 0 < done < rows
    for page, card in ((second, job(second, number)), (tab, first)):
        card.get_by_text(f"Of {done} rows so far ({rows} are wanted)").wait_for()
        assert card.get_by_role("row").filter(has_text="margin ≥").get_by_text("%").count() == 2
        card.get_by_role("figure").locator(".main-svg").first.wait_for()
        picture(page, "runs-campaign.png", full_page=True)
    os.killpg(command, signal.SIGCONT)
    first.get_by_text("done: the rows").wait_for()
    first.get_by_text(f"Of all {rows} rows").wait_for()
    headline = campaign_words.headline(summarise_campaign(ledger))
    api.expect(first.locator(".runs-figures").get_by_text(headline)).to_be_visible()
    fits(tab, "runs", picture)
    first.get_by_role("button", name="Write its report").click()
    first.get_by_role("button", name="Show campaign.html here").click()
    tab.frame_locator("iframe").get_by_text(headline).first.wait_for()
    picture(tab, "runs-campaign-report.png", full_page=True)
    ledger.unlink()


@pytest.mark.endurance  # test_studio_jobs.py and test_studio_runs_compare.py have it without a browser
def test_a_campaign_that_is_cancelled_goes_on_with_its_rows(studio, tab, opened):
    rows, ledger = 384, studio.folder / "campaign.ledger"
    first, number, command = begun(studio, tab, rows)
    second = opened("runs")
    there = job(second, number)
    done = rows_in(ledger)
    there.get_by_text(f"Of {done} rows so far").wait_for()
    tab.reload()
    there.get_by_role("button", name="Cancel").click()
    until(tab, (studio.folder / ".microrad-studio" / "jobs" / str(number) / "cancel").exists, "the cancel")
    os.killpg(command, signal.SIGCONT)
    for card in (first, there):
        card.get_by_text("cancelled").wait_for()
    kept = rows_in(ledger)
    assert done <= kept < rows
    first.get_by_text(f"Of {kept} rows so far").wait_for()
    first.get_by_role("button", name="Go on").click()
    again = second.get_by_role("article").filter(has_text="campaign resume campaign.ledger")
    again.get_by_text("done: the rows").wait_for()
    again.get_by_text(f"Of all {rows} rows").wait_for()
    assert job(tab, number).get_by_role("button", name="Go on").count() == 0
    api.expect(there.get_by_text("rows so far")).to_be_hidden()  # the ledger is the newer job's now


# ---------------------------------------------------------------------------------------------------------- each page
@pytest.mark.endurance  # at all widths; tests of each page end with a look at two
@pytest.mark.parametrize("name", server.PAGES)
def test_each_page_fits_and_has_no_serious_fault_for_those_who_do_not_see_it(opened, picture, name):
    module = import_module(f"microrad.studio.pages.{name}")
    tab = opened(module.PATH.removeprefix("/"))
    tab.get_by_role("heading", name=module.TITLE, level=1).wait_for()
    tab.locator(LATE.get(name, "h1")).first.wait_for()
    fits(tab, name, picture)


def test_each_page_is_looked_at_in_one_test_at_least():
    """Those of pointing, which is built as that of the links, by `make endurance`; all others here, too."""
    texts = [path.read_text("utf-8") for path in Path(__file__).parent.glob("*_browser.py")]
    assert {name for text in texts for name in re.findall(r'fits\(\w+, "(\w+)", picture\)', text)} == set(server.PAGES)
