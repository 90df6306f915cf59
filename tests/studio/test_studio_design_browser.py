"""The pages of links, pointing and day in a browser: sliders are moved and typed, and what they show follows."""

import json
import re

import pytest

import budgets
from browser import check_quiet, draft_is, fits, until
from microrad import link
from microrad.link.study import largest_rate
from microrad.report.quantities import signed
from microrad.studio.draft.draft import Draft
from microrad.studio.views import link as link_view
from microrad.studio.views.sliders import slider

APERTURE = "LEO aperture"
KEY = "terminals.leo_aperture"
DRAWN = """() => {
  const map = document.querySelector('.margin-map');
  window.drawn = [];
  map.on('plotly_afterplot', () => window.drawn.push(map.data[0].z[0][0]));
}"""
CORNER = "() => document.querySelector('.margin-map').data?.[0]?.z?.[0]?.[0]"


@pytest.fixture(scope="module")
def links_tab(studio, context):
    found = studio.enter(context, "link")
    yield found
    found.close()
    check_quiet(found, studio.base)


@pytest.fixture
def links(links_tab):
    """The page of the links with its map, on the paper's mission, as each test leaves it."""
    shown_margin(links_tab, "+3.00 dB")
    links_tab.wait_for_function(CORNER)
    draft_is(links_tab, "saved")
    assert typed(links_tab, APERTURE).input_value() == "5 cm"
    return links_tab


def typed(page, label):
    return page.get_by_label(label, exact=True)


def margins(page):
    return page.locator(".margin-card .value").all_inner_texts()


def shown_margin(page, words):
    page.wait_for_function("w => document.querySelector('.margin-card .value')?.textContent === w", arg=words)


def mission_at(file, **changes):
    """The mission with other values, as the command line reads it, and its sources."""
    draft = Draft.open(file)
    for key, value in changes.items():
        draft = draft.set(key.replace("__", "."), value)
    found = draft.link()
    return found.mission, found.sources


def margin_at(file, **changes):
    return signed(budgets.communication(*mission_at(file, **changes)).margin_db, "dB")


def written(studio):
    """The text that the studio keeps: what is tried only is not in it."""
    kept = studio.folder / ".microrad-studio" / "draft.json"
    return json.loads(kept.read_text("utf-8"))["text"] if kept.exists() else studio.file.read_text("utf-8")


# --------------------------------------------------------------------------------------------------------------- links
@pytest.mark.endurance  # as they follow steps and a slider that is moved
def test_the_margin_and_the_map_follow_a_typed_aperture(studio, links):
    before, text = links.evaluate(CORNER), written(studio)
    typed(links, APERTURE).fill("6 cm")
    shown_margin(links, margin_at(studio.file, terminals__leo_aperture="6 cm"))
    links.wait_for_function(f"before => ({CORNER})() !== before", arg=before)
    assert written(studio) == text  # typed and not let go
    typed(links, APERTURE).press("Enter")
    draft_is(links, "not saved")
    assert written(studio) == text.replace('leo_aperture = "5 cm"', 'leo_aperture = "6 cm"') != text
    rate = largest_rate(link.of(mission_at(studio.file, terminals__leo_aperture="6 cm")[0]))
    links.get_by_text(f"At most {rate / 1e6:.3g} Mbit/s at 10 µrad").wait_for()
    links.get_by_text(
        f"Largest data rate with the required 3 dB at the required 10 µrad: {rate / 1e6:.3g} Mbit/s."
    ).wait_for()
    typed(links, APERTURE).fill("5 cm")
    typed(links, APERTURE).press("Enter")
    draft_is(links, "saved")
    shown_margin(links, "+3.00 dB")


def test_a_slider_that_is_moved_shows_its_value_in_the_map_and_writes_it_when_let_go(studio, links):
    before, text = links.evaluate(CORNER), written(studio)
    typed(links, APERTURE).fill("7 cm")
    box = links.get_by_role("slider", name=f"{APERTURE}, slider").bounding_box()
    links.mouse.move(box["x"] + 0.55 * box["width"], box["y"] + box["height"] / 2)
    links.mouse.down()  # what was typed is not let go by it
    links.mouse.move(box["x"] + 0.7 * box["width"], box["y"] + box["height"] / 2, steps=4)
    links.wait_for_function(f"before => ({CORNER})() > before + 4.0", arg=before)
    assert written(studio) == text
    links.mouse.up()
    draft_is(links, "not saved")
    value = typed(links, APERTURE).input_value()
    assert 5.0 < float(value.removesuffix(" cm")) < 20.0
    there = margin_at(studio.file, terminals__leo_aperture=value)
    shown_margin(links, there)
    typed(links, APERTURE).fill("5 cm")
    typed(links, APERTURE).press("Enter")
    shown_margin(links, "+3.00 dB")


@pytest.mark.endurance  # as the day follows the links in another tab
def test_tabs_of_the_links_follow_each_other(studio, links, opened):
    typed(links, APERTURE).fill("7 cm")
    typed(links, APERTURE).press("Enter")
    there = margin_at(studio.file, terminals__leo_aperture="7 cm")
    shown_margin(links, there)
    draft_is(links, "not saved")
    second = opened("link")
    second.wait_for_function("() => document.querySelector('.margin-card .value')?.textContent")
    assert typed(second, APERTURE).input_value() == "7 cm"
    assert margins(second)[0] == there
    typed(second, APERTURE).fill("5 cm")
    typed(second, APERTURE).press("Enter")
    shown_margin(links, "+3.00 dB")  # the first tab follows the second
    assert typed(links, APERTURE).input_value() == "5 cm"


def test_a_slider_that_is_typed_is_in_the_file_that_a_click_on_save_writes_at_once(studio, links):
    before, size = studio.file.read_text("utf-8"), typed(links, APERTURE)
    for last in ("8 cm", "5 cm"):
        size.fill("7 cm")
        size.press("Enter")
        draft_is(links, "not saved")
        size.fill(last)
        links.get_by_role("button", name="Save", exact=True).click()
        draft_is(links, "saved")
        assert studio.file.read_text("utf-8") == before.replace('leo_aperture = "5 cm"', f'leo_aperture = "{last}"')
    shown_margin(links, "+3.00 dB")


def test_quick_steps_of_a_slider_never_go_back_and_end_at_the_last_in_map_field_and_mission(studio, links):
    aperture = slider(Draft.open(studio.file).values[KEY])
    last = aperture.at(aperture.position + 12)
    links.evaluate(DRAWN)
    links.get_by_role("slider", name=f"{APERTURE}, slider").locator("[tabindex='0']").focus()
    for _ in range(12):
        links.keyboard.press("ArrowRight")
    until(links, lambda: f'leo_aperture = "{last}"' in written(studio), "the last step")
    there = margin_at(studio.file, terminals__leo_aperture=last)
    shown_margin(links, there)
    links.get_by_text(f"the communication link has {there}.").wait_for()
    assert typed(links, APERTURE).input_value() == last
    drawn = links.evaluate("window.drawn")
    assert drawn == sorted(drawn)
    view = link_view.view(Draft.open(studio.file).set(KEY, last).link())
    assert drawn[-1] == pytest.approx(view.margin_db[0, 0], abs=0.006)
    typed(links, APERTURE).fill("5 cm")
    typed(links, APERTURE).press("Enter")
    draft_is(links, "saved")
    shown_margin(links, "+3.00 dB")


def test_a_wrong_unit_is_told_beside_its_field_and_the_last_map_stays(studio, links):
    typed(links, APERTURE).fill("5 W")
    told = links.locator(".slider", has=typed(links, APERTURE)).get_by_role("alert")
    told.wait_for()
    (fault,) = Draft.open(studio.file).set("terminals.leo_aperture", "5 W").problems
    assert told.inner_text() == f"{fault.reason}; expected {fault.expected}"
    links.get_by_text("Shown in grey: the mission before this.").wait_for()
    assert margins(links)[0] == "+3.00 dB"
    assert links.locator(".margin-map.behind").count() == 1
    typed(links, APERTURE).fill("5 cm")
    told.wait_for(state="hidden")
    links.locator(".margin-map.behind").wait_for(state="detached")
    assert typed(links, APERTURE).get_attribute("aria-invalid") == "false"


@pytest.mark.endurance  # test_studio_design.py has it without a browser
def test_a_page_that_is_opened_on_a_faulty_mission_promises_nothing_in_grey(studio, links, context):
    links.get_by_text("The links close, and ").wait_for()
    typed(links, APERTURE).fill("5 W")
    typed(links, APERTURE).press("Enter")
    until(links, lambda: 'leo_aperture = "5 W"' in written(studio), "the fault")
    opened_now = studio.enter(context, "link")
    opened_now.get_by_text("Nothing can be shown before the mission is corrected.").wait_for()
    assert opened_now.get_by_text("Shown in grey").count() == 0
    opened_now.get_by_text("Of the mission before this:").wait_for()
    assert opened_now.locator(".behind").get_by_text("The links close, and ").is_visible()
    opened_now.close()
    check_quiet(opened_now, studio.base)
    typed(links, APERTURE).fill("5 cm")
    typed(links, APERTURE).press("Enter")
    draft_is(links, "saved")
    shown_margin(links, "+3.00 dB")


def test_the_budget_of_another_link_is_chosen_and_the_page_copied_as_a_command(studio, links, picture):
    links.get_by_text("The links close, and ").wait_for()
    links.get_by_role("button", name="Beacon", exact=True).click()
    beacon = budgets.beacon(*mission_at(studio.file))
    row = links.locator("tr.total").filter(has_text="Margin")
    row.get_by_text(f"{beacon.margin_db:.2f} dB").wait_for()
    links.get_by_text("every requirement is met").wait_for()  # of the study, which comes last
    fits(links, "link", picture)
    links.get_by_role("button", name="Copy as command").click()
    links.get_by_text("Copied: microrad budget leo-geo.toml").wait_for()
    assert links.evaluate("navigator.clipboard.readText()") == "microrad budget leo-geo.toml"


# ------------------------------------------------------------------------------------------------------------ pointing
LEGENDS = """() => [...document.querySelectorAll('.js-plotly-plot')]
    .every(plot => plot.clientWidth > 300 && plot._fullLayout?._size.h > 190)"""
"""That no legend takes the room of the data."""


@pytest.mark.endurance  # test_studio_design.py has it without a browser
def test_the_coverage_follows_the_beacon_s_divergence_and_a_narrow_page_has_one_column(studio, opened, picture):
    page = opened("pointing")
    page.get_by_text("with a probability of 0.53").wait_for()
    typed(page, "Divergence").fill("1310 urad")
    wide = budgets.open_loop(*mission_at(studio.file, beacon__divergence="1310 urad"))
    page.get_by_text(f"with a probability of {wide.reading.coverage:.4f}").wait_for()
    page.get_by_role("button", name="Totals at 99.7 %").click()
    page.get_by_role("row").filter(has_text="radial distribution").get_by_text("covers it").wait_for()
    typed(page, "Divergence").fill("780 urad")
    page.get_by_text("with a probability of 0.53").wait_for()
    fits(page, "pointing", picture)
    page.set_viewport_size({"width": 400, "height": 900})
    page.wait_for_function(LEGENDS)


# ----------------------------------------------------------------------------------------------------------------- day
@pytest.mark.endurance
def test_the_day_is_computed_with_progress_and_a_second_tab_finds_it_and_says_whose_it_is(opened, links, picture):
    page = opened("day")
    page.get_by_text(re.compile("^Computing, |^The day of the mission as it stands")).first.wait_for()
    page.get_by_text("In 24 h the relay is in view 15 times").wait_for()
    page.get_by_role("button", name="What the ways could carry").click()
    page.get_by_role("row").filter(has_text="time in contact").get_by_text("913 min").wait_for()
    page.wait_for_function("() => document.querySelectorAll('.js-plotly-plot .barlayer .point').length > 30")
    fits(page, "day", picture)
    page.close()

    again = opened("day")
    again.get_by_text("In 24 h the relay is in view 15 times").wait_for()
    assert again.get_by_text("Computing, ").count() == 0
    again.get_by_text("The day of the mission as it stands.").wait_for()
    typed(links, APERTURE).fill("5 W")
    typed(links, APERTURE).press("Enter")
    again.get_by_text("The day of the mission before this.").wait_for()
    assert again.locator(".behind").get_by_text("In 24 h the relay is in view 15 times").is_visible()
    typed(links, APERTURE).fill("5 cm")
    typed(links, APERTURE).press("Enter")
    again.get_by_text("The day of the mission as it stands.").wait_for()
    again.locator(".behind").wait_for(state="detached")
