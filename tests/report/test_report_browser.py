"""The report in Chromium: nothing is loaded, no error, each figure comes alive and prints, and anyone can read it."""

import os
import re
from functools import cache, partial
from pathlib import Path

import pytest

from browser import violations
from microrad import report
from microrad.lab.identify import identify
from microrad.report.campaign.page import campaign_page
from microrad.report.day.page import day_page
from microrad.report.links.views import links_page
from report import test_coupled_report as several
from report import test_identification_report as identified
from report import test_report_campaign as campaigns
from shipped import whole_drawn, whole_study
from waiting import HANG_MS

A4_PX = 680  # between the margins
ALIVE = {"report": 20, "day": 6, "campaign": 6, "identification": 5, "channels": 4}
"""Pages with interactive figures, and how many they have at least."""
SEEN = [("campaign", 1280), ("identification", 400), ("report", 400)]
SEEN += [
    pytest.param(*each, marks=pytest.mark.endurance)
    for each in (
        ("report", 1280),
        ("day", 400),
        ("day", 1280),
        ("campaign", 400),
        ("identification", 1280),
        ("channels", 400),
        ("channels", 1280),
    )
]
"""Pages and widths: each page once, that of a day within the report, which has its figures, and that of several
channels as the other identification; what else is done with the report is done at its full width."""
MOST_BYTES, MOST_PX = 4_000_000, 15_000
"""Of a page, and the height of that of the paper's mission at its full width as it opens."""


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """Writes a page, of every kind that there is, once; the report is that of the paper's whole mission."""
    folder = tmp_path_factory.mktemp("browser")
    recordings = [identified.loop(60.0, 1, "60.csv"), identified.loop(100.0, 3, "100.csv"), identified.chirp()]
    texts = {
        "day": lambda: day_page(whole_study()[0].day, whole_study()[0].links),
        "budget": lambda: links_page(whole_study()[0].links),
        "campaign": lambda: campaign_page(campaigns.CASES["two inputs"]()),
    }

    @cache
    def written(name):
        if name == "report":
            drawn = whole_drawn()
            with pytest.MonkeyPatch.context() as patch:
                patch.setattr(report, "study_figures", lambda *_: drawn)
                return report.write(whole_study()[0], folder / "study")
        if name == "channels":
            return several.page_of(several.found_of(), folder, "channels.html")
        if name == "identification":
            mirror = identify(recordings, 0.5, models=("prandtl_ishlinskii", "linear"))
            return identified.write(mirror, folder / "identification.html", recordings=recordings)
        (folder / f"{name}.html").write_text(texts[name](), encoding="utf-8")
        return folder / f"{name}.html"

    return written


class Opened:
    """A page with what it said and asked for, unfolded unless told otherwise."""

    def __init__(self, browser, file, width=1280, unfolded=True, anchor="", **options):
        self.page = browser.new_page(viewport={"width": width, "height": 900}, **options)
        self.page.set_default_timeout(HANG_MS)
        self.said, self.asked = [], []
        self.page.on("console", lambda message: self.said.append(message.text))
        self.page.on("pageerror", lambda error: self.said.append(str(error)))
        self.page.on("request", lambda request: self.asked.append(request.url))
        self.page.goto(file.as_uri() + anchor)
        if unfolded:
            self.page.evaluate("document.querySelectorAll('details.view').forEach(each => { each.open = true })")

    def figures(self, kind="figure:has(> script.plot)"):
        return self.page.query_selector_all(kind)

    def ready(self, figure):
        """Bring a figure into view and wait until it is interactive."""
        figure.scroll_into_view_if_needed()
        self.page.wait_for_function("figure => figure.classList.contains('ready')", arg=figure)
        return figure

    def figure(self, title):
        return self.ready(self.page.query_selector(f"figure[aria-label^='{title}']"))


@pytest.fixture
def opened(browser, files):
    made = []

    def open_(name="report", width=1280, **options):
        made.append(Opened(browser, files(name), width, **options))
        return made[-1]

    yield open_
    for each in made:
        each.page.close()


@pytest.fixture(scope="module")
def report_page(browser, files):
    """The report at its full width, unfolded, for tests that leave it so."""
    found = Opened(browser, files("report"))
    yield found
    found.page.close()


@pytest.fixture(scope="module")
def folded_page(browser, files):
    """The report at its full width as it opens, for tests that leave it so."""
    found = Opened(browser, files("report"), unfolded=False)
    yield found
    found.page.close()


def visible(figure, selector):
    return figure.query_selector(selector).is_visible()


@pytest.mark.promise("report-2", "report-3", "report-11", "report-12")
@pytest.mark.parametrize(("name", "width"), SEEN)
def test_each_figure_comes_alive_and_nothing_is_loaded_or_complained_of(opened, files, name, width):
    assert files(name).stat().st_size <= MOST_BYTES
    here = opened(name, width)
    figures = here.figures()
    assert len(figures) >= ALIVE[name]
    first = figures[-1]
    assert visible(first, ".picture svg")  # before it comes into view
    for figure in figures:
        here.ready(figure)
        assert visible(figure, ".interactive .main-svg")
        assert not visible(figure, ".picture")
        assert figure.query_selector_all(".tools button")
    assert here.said == []
    assert set(here.asked) == {files(name).as_uri()}
    assert here.page.evaluate("document.documentElement.scrollWidth") <= width
    ids = here.page.evaluate("[...document.querySelectorAll('[id]')].map(each => each.id)")
    assert len(ids) == len(set(ids)) > 30
    if (name, width) != ("report", 1280):  # the longest page is looked at once
        assert_no_barrier(here.page)


FEWER = """document.querySelectorAll('tbody').forEach(body => {
  [...body.rows].slice(4).forEach(row => row.querySelector('.mark') || row.remove());
});
[...document.querySelectorAll('figure .interactive')].slice(6).forEach(each => each.remove())"""
"""Leaves four rows of each table and those with a mark, and six drawings that are alive: the others look like these,
and axe takes long for each."""


def assert_no_barrier(page):
    """That axe finds nothing, what is folded opened; the page is left with fewer rows and drawings."""
    page.evaluate("document.querySelectorAll('details').forEach(each => { each.open = true })")
    if not os.environ.get("MICRORAD_ENDURANCE"):
        page.evaluate(FEWER)
    found = violations(page)
    assert [(each["id"], each["impact"], each["nodes"][0]["html"][:150]) for each in found] == []


@pytest.mark.promise("report-12")
@pytest.mark.parametrize("width", [400, pytest.param(1280, marks=pytest.mark.endurance)])
def test_the_page_of_budgets_is_pictures_with_their_numbers_below(opened, files, width):
    here = opened("budget", width)
    assert all(visible(figure, "svg[role=img]") for figure in here.figures("figure"))
    assert len(here.figures("figure")) == len(here.figures("figure + details")) == 4
    assert len(here.figures("script")) == 1  # for the keyboard
    assert here.said == []
    assert set(here.asked) == {files("budget").as_uri()}
    assert here.page.evaluate("document.documentElement.scrollWidth") <= width
    assert_no_barrier(here.page)


GROUND = "selector => getComputedStyle(document.querySelector(selector)).backgroundColor"


@pytest.mark.promise("report-9")
def test_the_page_is_dark_where_the_browser_is_and_its_figures_stay_white(opened):
    dark, light, white = "rgb(15, 20, 25)", opened("budget"), "rgb(255, 255, 255)"
    assert light.page.evaluate(GROUND, "body") == white
    here = opened("budget", color_scheme="dark")
    assert here.page.evaluate(GROUND, "body") == dark
    assert here.page.evaluate(GROUND, ":is(.picture, .drawings):has(svg)") == white


@pytest.mark.promise("report-11")
def test_a_legend_switches_a_curve_by_the_keyboard(report_page):
    here = report_page
    figure = here.figure("Fig. 8")
    button = figure.query_selector(".keys button")
    shown = "figure => figure.querySelectorAll('.scatterlayer .trace').length"
    before = here.page.evaluate(shown, figure)
    assert button.get_attribute("aria-pressed") == "true"
    button.focus()
    here.page.keyboard.press("Enter")
    here.page.wait_for_function(f"([figure, count]) => ({shown})(figure) === count", arg=[figure, before - 1])
    assert button.get_attribute("aria-pressed") == "false"
    here.page.keyboard.press("Space")
    here.page.wait_for_function(f"([figure, count]) => ({shown})(figure) === count", arg=[figure, before])


@pytest.mark.promise("report-11")
def test_hovering_gives_values_with_units(report_page):
    here = report_page
    figure = here.figure("Fig. 2")
    box = figure.query_selector(".nsewdrag").bounding_box()
    here.page.mouse.move(box["x"] + 0.3 * box["width"], box["y"] + 0.8 * box["height"])
    here.page.wait_for_function("figure => figure.querySelector('.hoverlayer text')", arg=figure)
    said = " ".join(each.text_content() for each in figure.query_selector_all(".hoverlayer text"))
    assert re.search(r"data rate: [\d.]+ Mbit/s.*pointing error: [\d.]+ µrad.*link margin: [\d.−]+ dB", said)


@pytest.mark.promise("report-11")
def test_zoom_and_reset(report_page):
    here = report_page
    figure = here.figure("Fig. 5")
    limits = "figure => { const drawn = figure.querySelector('.js-plotly-plot').layout; return drawn.xaxis.range }"
    first = here.page.evaluate(limits, figure)
    zoom_in, zoom_out, drags, reset = figure.query_selector_all(".tools button")[:4]
    zoom_in.click()
    near = here.page.evaluate(limits, figure)
    assert near[1] - near[0] == pytest.approx((first[1] - first[0]) / 2)
    zoom_out.click()
    assert here.page.evaluate(limits, figure) == pytest.approx(first)
    zoom_out.click()
    reset.click()
    assert here.page.evaluate(limits, figure) == first
    drags.click()
    assert drags.get_attribute("aria-pressed") == "true"


def test_a_figure_follows_the_width_of_the_page(report_page):
    here = report_page
    figure = here.figure("Fig. 8")
    here.page.set_viewport_size({"width": 420, "height": 900})
    narrow = "figure => figure.querySelector('.main-svg').getBoundingClientRect().width < 420"
    here.page.wait_for_function(narrow, arg=figure)
    layout = here.page.evaluate("figure => figure.querySelector('.js-plotly-plot').layout", figure)
    upper, lower = layout["yaxis"]["domain"], layout["yaxis2"]["domain"]
    assert lower[1] < upper[0]  # one below the other
    assert here.said == []
    here.page.set_viewport_size({"width": 1280, "height": 900})
    here.page.wait_for_function(f"figure => !({narrow})(figure)", arg=figure)


@pytest.mark.promise("report-2", "report-10", "report-11")
def test_the_pictures_print_and_the_buttons_do_not(report_page, tmp_path):
    here = report_page
    for figure in here.figures()[:3]:
        here.ready(figure)
    here.page.emulate_media(media="print")
    for figure in here.figures():
        assert visible(figure, ".picture svg")
        assert figure.query_selector(".interactive") is None or not visible(figure, ".interactive")
    printed = tmp_path / "report.pdf"
    here.page.pdf(path=str(printed))
    assert printed.stat().st_size > 200_000
    here.page.emulate_media(media="screen")


SHOWN = "each => each.getBoundingClientRect().height > 2 * each.querySelector('summary').getBoundingClientRect().height"


@pytest.mark.promise("report-10")
@pytest.mark.parametrize(
    "name",
    [
        "report",
        *(
            pytest.param(e, marks=pytest.mark.endurance)
            for e in ("campaign", "identification", "channels", "day", "budget")
        ),
    ],
)
def test_paper_is_wide_enough_and_shows_what_is_folded(opened, folded_page, name):
    here = folded_page if name == "report" else opened(name, unfolded=False)
    here.page.set_viewport_size({"width": A4_PX, "height": 900})
    folded = here.figures("main details:not([open]):not(.data)")
    assert folded
    here.page.emulate_media(media="print")
    assert here.page.evaluate("document.documentElement.scrollWidth") <= A4_PX  # else all of it would print smaller
    assert [each.inner_text()[:50] for each in folded if not here.page.evaluate(SHOWN, each)] == []
    assert not any(each.is_visible() for each in here.figures("nav, button, details.data"))
    here.page.emulate_media(media="screen")
    here.page.set_viewport_size({"width": 1280, "height": 900})


@pytest.mark.promise("report-11")
def test_without_scripts_every_figure_is_its_picture(opened):
    here = opened(unfolded=False, java_script_enabled=False)
    assert len(here.figures("figure")) > 10
    shown = here.figures(":not(details) > figure:has(> script.plot)")
    assert len(shown) > 3
    assert all(visible(figure, "svg[role=img]") for figure in shown)
    assert here.page.query_selector(".interactive") is None


@pytest.mark.promise("report-11")
def test_points_are_saved_as_a_table_where_there_is_no_folder(opened):
    here = opened("day")
    figure = here.figure("From recording to delivery")
    with here.page.expect_download() as download:
        figure.query_selector(".tools button:last-child").click()
    rows = Path(download.value.path()).read_text(encoding="utf-8").splitlines()
    assert download.value.suggested_filename == "latency.csv"
    assert rows[0] == "curve,x,y,z"
    assert len(rows) > 100
    assert here.figure("Contacts").query_selector("a") is None


# ------------------------------------------------------------------------------------------- contents, links and rows
HERE = """id => {
  const place = document.getElementById(id).getBoundingClientRect();
  return place.height > 100 && place.top > -5 && place.top < innerHeight;
}"""
"""Whether something that was folded is open and in view."""


@pytest.mark.promise("report-9")
def test_a_link_opens_what_is_folded_about_its_place(opened):
    inner, figure = "by-other-readings", "figure-fig5-hysteresis-loops"
    here = opened(unfolded=False, anchor=f"#{inner}")
    here.page.wait_for_function(HERE, arg=inner)
    assert not here.page.evaluate(HERE, figure)
    here.page.evaluate("hash => { location.hash = hash }", figure)  # as one does who edits the address
    here.page.wait_for_function(HERE, arg=figure)
    assert here.page.evaluate("id => document.getElementById(id).closest('details').open", figure)
    fold = "id => { document.getElementById(id).open = false; scrollTo(0, 0) }"
    here.page.evaluate(fold, inner)
    assert not here.page.evaluate(HERE, inner)
    here.page.click(f"nav.contents a[href='#{inner}']")
    here.page.wait_for_function(HERE, arg=inner)
    here.page.evaluate(fold, inner)
    here.page.click(f"nav.contents a[href='#{inner}']")  # a second time, with the same address
    here.page.wait_for_function(HERE, arg=inner)
    here.page.evaluate(fold, inner)
    link = here.page.query_selector(f"main a.anchor[href='#{inner}']")
    link.scroll_into_view_if_needed()
    link.click()
    here.page.wait_for_function(HERE, arg=inner)
    assert here.said == []


@pytest.mark.promise("report-9")
def test_each_heading_links_to_itself(report_page):
    link = "h.id ? h.lastChild : h.closest('details').previousElementSibling"
    pair = f"[h.id || h.closest('details').id, ({link}).hash]"
    links = f"[...document.querySelectorAll('main :is(h2, h3, h4)')].map(h => {pair})"
    found = report_page.page.evaluate(links)
    assert len(found) > 25
    assert [(anchor, link) for anchor, link in found if link != f"#{anchor}"] == []


@pytest.mark.promise("report-9")
def test_a_sign_beside_a_title_is_shown_under_the_pointer(folded_page):
    page = folded_page.page
    sign = "a => [getComputedStyle(a, '::before').content, getComputedStyle(a).opacity]"
    for heading, link in (
        ("main h2:has(> a.anchor)", "main h2 > a.anchor"),
        ("main a.anchor.beside + details > summary", "main a.anchor.beside:has(+ details > summary)"),
    ):
        page.mouse.move(0, 0)
        assert page.eval_on_selector(link, sign) == ['"#"', "0"]
        page.locator(heading).first.hover()
        assert page.eval_on_selector(link, sign) == ['"#"', "1"]


@pytest.mark.promise("report-9")
def test_what_is_folded_stands_behind_a_line_of_its_own(folded_page):
    lines = "[...document.querySelectorAll('main details')].map(d => [d.open, d.firstElementChild])"
    found = folded_page.page.evaluate(f"{lines}.map(([open, line]) => [open, line.tagName, line.textContent.trim()])")
    assert len(found) > 25
    assert {(is_open, tag) for is_open, tag, _ in found} == {(False, "SUMMARY")}
    assert [words for _, _, words in found if len(words) < 5] == []


BOXES = "[...document.querySelectorAll('.chain li')].map(each => Math.round(each.getBoundingClientRect().left))"


@pytest.mark.promise("report-9")
def test_contents_stand_open_and_the_chain_in_rows_where_there_is_room_for_them(folded_page, opened):
    here = folded_page
    lefts = here.page.evaluate(BOXES)
    assert lefts == [*sorted(set(lefts))] * 2 and len(lefts) == 8
    first = "nav.contents li a"
    assert here.page.is_visible(first)
    assert here.page.evaluate("document.querySelector('nav.contents').getBoundingClientRect().right") < 400
    here.page.set_viewport_size({"width": 400, "height": 900})
    here.page.wait_for_selector(first, state="hidden")
    assert here.page.is_visible("nav.contents summary")
    here.page.set_viewport_size({"width": 1280, "height": 900})
    here.page.wait_for_selector(first)
    narrow = opened(width=400, unfolded=False)
    assert len(set(narrow.page.evaluate(BOXES))) == 1
    assert not narrow.page.is_visible(first)
    narrow.page.click("nav.contents summary")
    assert narrow.page.is_visible(first)


@pytest.mark.promise("mirror-file-6")
@pytest.mark.promise("report-6", "report-9")
def test_buttons_and_search_leave_the_rows_that_they_name(report_page):
    """By the keys: what was just unfolded may still move away from under a pointer."""
    here = report_page
    here.page.evaluate("document.querySelectorAll('details').forEach(each => { each.open = true })")
    box = here.page.query_selector(".filters")
    table = box.evaluate_handle("box => box.nextElementSibling").as_element()
    shown = "table => [...table.querySelectorAll('tbody tr')].filter(r => r.checkVisibility()).map(r => r.innerText)"
    rows = partial(table.evaluate, shown)
    every = rows()
    whole, assumed, *_ = buttons = box.query_selector_all("button")
    assert whole.inner_text() == f"all {len(every)}"
    assumed.press("Enter")
    chosen = rows()
    assert assumed.inner_text() == f"assumptions ({len(chosen)})"
    assert chosen == [row for row in every if "assumption" in row.split("\t")[-1]]
    assert 0 < len(chosen) < len(every)
    assert [each.get_attribute("aria-pressed") for each in buttons] == [
        "false",
        "true",
        *["false"] * (len(buttons) - 2),
    ]
    box.query_selector("input").fill("BEACON.")
    assert rows() == [row for row in chosen if "beacon." in row.lower()]
    assert 0 < len(rows()) < len(chosen)
    whole.press("Enter")
    assert rows() == [row for row in every if "beacon." in row.lower()]
    box.query_selector("input").fill("")
    assert rows() == every


def test_the_page_of_a_whole_study_is_not_long(folded_page):
    assert 5_000 < folded_page.page.evaluate("document.documentElement.scrollHeight") <= MOST_PX
