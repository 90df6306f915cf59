"""The pages of links, pointing and day in a browser: dials are moved and typed, and what they show follows."""

import re
import shutil
import signal
import subprocess
import sys

import pytest

from microrad import link_study
from microrad.link_study import largest_rate
from microrad.report.budget_views import signed_db
from microrad.studio.draft import Draft
from shipped import SHIPPED

pytestmark = pytest.mark.long

pytest.importorskip("nicegui", reason="the studio is not installed (nicegui)")
api = pytest.importorskip("playwright.sync_api", reason="Playwright is not installed")

LONG_MS = 120_000  # on a machine with other work to do
APERTURE = "LEO aperture"
CORNER = "() => document.querySelector('.margin-map').data?.[0]?.z?.[0]?.[0]"


@pytest.fixture(scope="module")
def studio(tmp_path_factory):
    """The command in a folder with the paper's mission: its address, and the file."""
    folder = tmp_path_factory.mktemp("studio")
    shutil.copy(SHIPPED, folder / "mission.toml")
    command = [sys.executable, "-m", "microrad", "studio", "mission.toml", "--no-browser"]
    process = subprocess.Popen(
        command, cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True
    )
    url = process.stdout.readline().strip()
    if not url:
        pytest.fail(f"the studio did not start: {process.communicate()[1]}")
    yield url, folder / "mission.toml"
    process.send_signal(signal.SIGINT)
    _, told = process.communicate(timeout=30)
    assert (process.returncode, told) == (0, "")


@pytest.fixture(scope="module")
def context():
    program = shutil.which("chromium")
    if program is None:
        pytest.skip("Chromium is not installed")
    with api.sync_playwright() as play:
        browser = play.chromium.launch(executable_path=program, args=["--no-sandbox"])
        found = browser.new_context(viewport={"width": 1400, "height": 900})
        found.grant_permissions(["clipboard-read", "clipboard-write"])
        yield found
        browser.close()


@pytest.fixture
def tab(studio, context):
    """A tab that has shown the token; nothing of it may fail, or ask another host."""
    page, complaints, asked = context.new_page(), [], []
    page.set_default_timeout(LONG_MS)
    page.on("console", lambda m: complaints.append(m.text) if m.type in ("error", "warning") else None)
    page.on("pageerror", lambda error: complaints.append(str(error)))
    page.on("request", lambda request: asked.append(request.url))
    page.goto(studio[0])
    yield page
    page.close()
    assert complaints == []
    assert len(asked) > 5
    assert [url for url in asked if not re.match(r"(http|ws)://127\.0\.0\.1:|data:|blob:", url)] == []


def show(page, name):
    page.get_by_role("link", name=name, exact=True).click()
    page.get_by_role("heading", name=name, level=1).wait_for()


def typed(page, label):
    return page.get_by_label(label, exact=True)


def margins(page):
    return page.locator(".margin-card .value").all_inner_texts()


def shown_margin(page, words):
    page.wait_for_function("w => document.querySelector('.margin-card .value')?.textContent === w", arg=words)


def margin_at(file, **changes):
    draft = Draft.open(file)
    for key, value in changes.items():
        draft = draft.set(key.replace("__", "."), value)
    return link_study.run(draft.link())


# --------------------------------------------------------------------------------------------------------------- links
def test_the_margin_and_the_map_follow_a_typed_aperture(studio, tab):
    show(tab, "Links")
    shown_margin(tab, "+3.00 dB")
    tab.wait_for_function(CORNER)
    before = tab.evaluate(CORNER)
    typed(tab, APERTURE).fill("6 cm")
    wider = margin_at(studio[1], terminals__leo_aperture="6 cm")
    shown_margin(tab, signed_db(wider.communication.margin_db))
    tab.wait_for_function(f"before => ({CORNER})() !== before", arg=before)
    # typed and not let go: nothing is written
    assert tab.get_by_text("not saved", exact=True).count() == 0
    typed(tab, APERTURE).press("Enter")
    tab.get_by_text("not saved", exact=True).wait_for()
    rate = largest_rate(wider.file.mission)
    tab.get_by_text(f"At most {rate / 1e6:.3g} Mbit/s at 10 µrad").wait_for()
    tab.get_by_text(f"Largest data rate with the required 3 dB at 10 µrad: {rate / 1e6:.3g} Mbit/s.").wait_for()
    typed(tab, APERTURE).fill("5 cm")
    typed(tab, APERTURE).press("Enter")
    tab.get_by_role("status").get_by_text("saved", exact=True).wait_for()
    shown_margin(tab, "+3.00 dB")


def test_a_slider_that_is_moved_shows_its_value_in_the_map_and_writes_it_when_let_go(studio, tab):
    show(tab, "Links")
    shown_margin(tab, "+3.00 dB")
    tab.wait_for_function(CORNER)
    before, slider = tab.evaluate(CORNER), tab.get_by_role("slider", name=f"{APERTURE}, slider")
    box = slider.bounding_box()
    tab.mouse.move(box["x"] + 0.55 * box["width"], box["y"] + box["height"] / 2)
    tab.mouse.down()
    tab.mouse.move(box["x"] + 0.7 * box["width"], box["y"] + box["height"] / 2, steps=4)
    tab.wait_for_function(f"before => ({CORNER})() > before + 0.5", arg=before)
    tab.wait_for_timeout(600)
    assert tab.get_by_text("not saved", exact=True).count() == 0
    tab.mouse.up()
    tab.get_by_text("not saved", exact=True).wait_for()
    value = typed(tab, APERTURE).input_value()
    assert 5.0 < float(value.removesuffix(" cm")) < 20.0
    shown_margin(tab, signed_db(margin_at(studio[1], terminals__leo_aperture=value).communication.margin_db))
    second = tab.context.new_page()
    second.goto(studio[0])
    show(second, "Links")
    second.wait_for_function("() => document.querySelector('.margin-card .value')?.textContent")
    assert typed(second, APERTURE).input_value() == value
    typed(second, APERTURE).fill("5 cm")
    typed(second, APERTURE).press("Enter")
    shown_margin(tab, "+3.00 dB")  # the first tab follows the second
    assert typed(tab, APERTURE).input_value() == "5 cm"
    second.close()


def test_a_wrong_unit_is_told_beside_its_field_and_the_last_map_stays(studio, tab):
    show(tab, "Links")
    shown_margin(tab, "+3.00 dB")
    typed(tab, APERTURE).fill("5 W")
    told = tab.locator(".dial", has=typed(tab, APERTURE)).get_by_role("alert")
    told.wait_for()
    (fault,) = Draft.open(studio[1]).set("terminals.leo_aperture", "5 W").problems
    assert told.inner_text() == f"{fault.reason}; expected {fault.expected}"
    tab.get_by_text("Shown in grey: the mission before this.").wait_for()
    assert margins(tab)[0] == "+3.00 dB"
    assert tab.locator(".margin-map-box.behind").count() == 1
    typed(tab, APERTURE).fill("5 cm")
    told.wait_for(state="hidden")
    tab.locator(".margin-map-box.behind").wait_for(state="detached")
    assert typed(tab, APERTURE).get_attribute("aria-invalid") == "false"


def test_the_budget_of_another_link_is_chosen_and_the_page_copied_as_a_command(studio, tab):
    show(tab, "Links")
    tab.get_by_text("The links close: ").wait_for()
    tab.get_by_role("button", name="Beacon", exact=True).click()
    beacon = margin_at(studio[1]).beacon
    row = tab.locator("tr.total").filter(has_text="Margin")
    row.get_by_text(f"{beacon.margin_db:.2f} dB").wait_for()
    tab.get_by_role("button", name="Copy as command").click()
    tab.get_by_text("Copied: microrad budget mission.toml").wait_for()
    assert tab.evaluate("navigator.clipboard.readText()") == "microrad budget mission.toml"


# ------------------------------------------------------------------------------------------------------------ pointing
def test_the_coverage_follows_the_beacon_s_divergence(studio, tab):
    show(tab, "Pointing")
    tab.get_by_text("with a probability of 0.53").wait_for()
    typed(tab, "Divergence").fill("1310 urad")
    wide = margin_at(studio[1], beacon__divergence="1310 urad").open_loop
    tab.get_by_text(f"with a probability of {wide.reading.coverage:.4f}").wait_for()
    tab.get_by_role("cell", name="off the line of sight").first.wait_for()
    assert tab.get_by_role("row").filter(has_text="radial distribution").get_by_text("covered").count() == 1


# ----------------------------------------------------------------------------------------------------------------- day
def test_the_day_is_computed_with_progress_and_a_second_tab_finds_it(studio, tab):
    show(tab, "Day")
    tab.get_by_text("Computing, ").wait_for()
    tab.get_by_text("In 24 h the relay is in view 15 times").wait_for()
    assert tab.get_by_role("row").filter(has_text="time in contact").get_by_text("913 min").count() == 1
    tab.wait_for_function("() => document.querySelectorAll('.js-plotly-plot .barlayer .point').length > 30")
    again = tab.context.new_page()
    again.goto(studio[0])
    show(again, "Day")
    again.get_by_text("In 24 h the relay is in view 15 times").wait_for()
    assert again.get_by_text("Computing, ").count() == 0
    again.close()
