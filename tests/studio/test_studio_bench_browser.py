"""The pages on mirror and control in Debian's Chromium: a recording dropped, its loop, a live fit, a chosen controller.

The recording is the real one of 1 Hz where it is present, else one of the virtual bench.
"""

import http.client
import itertools
import re
import tomllib
from urllib.parse import urlsplit

import numpy as np
import pytest

from browser import check_quiet, draft_is, fits, until
from cli.test_cli import write_recording
from microrad.lab import bench
from microrad.studio.views.mirror import read_fits
from microrad.studio.views.mirror_form import kept_form
from places import DATA

api = pytest.importorskip("playwright.sync_api", reason="Playwright is not installed")

REAL = DATA / "piezo_1hz/Model_Vi_Do.dat"


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    """The file to drop, and what the form has to say of it."""
    folder = tmp_path_factory.mktemp("bench")
    if REAL.exists():
        rows = REAL.read_text("utf-8").splitlines(keepends=True)[:2000]  # ten of its forty periods
        (folder / REAL.name).write_text("".join(rows), "utf-8")
        return folder / REAL.name, {
            "output": "column 4",
            "unit": "µm",
            "rate": "200 Hz",
            "arm": "50 mm",
            "said": "type the sample rate",
        }
    files = bench.write_folder(
        bench.load_plan("paper-experiment"), folder / "played", 0, False, lambda done, total, what: None
    )
    loop = next(path for path in files if path.stem == "loop-100hz")
    return loop, {"output": None, "unit": None, "rate": "", "arm": "", "said": ""}


@pytest.fixture(scope="module")
def mirror(studio, context):
    """The page of the mirror, whose list of files each test leaves empty."""
    found = studio.enter(context, "mirror")
    yield found
    found.close()
    check_quiet(found, studio.base)


def drop(tab, file):
    with tab.expect_response(lambda answer: "/upload/" in answer.url) as answer:
        tab.get_by_label("Recordings: drop files here, or choose them").set_input_files(file)
    return answer.value.url


def break_off(tab, url):
    """Begin to send a file there, and go away."""
    cookies = "; ".join(f"{each['name']}={each['value']}" for each in tab.context.cookies(url))
    own = urlsplit(url)
    heads = {"Cookie": cookies, "Origin": f"{own.scheme}://{own.netloc}", "Content-Length": "1000"}
    gone = http.client.HTTPConnection(own.netloc)
    gone.request("POST", own.path, b"--b\r\n", {**heads, "Content-Type": "multipart/form-data; boundary=b"})
    gone.close()


def traces(tab, label):
    """The lines of a plot, by name."""
    figure = tab.get_by_label(label, exact=True)
    found = figure.evaluate("plot => plot.data.map(each => [each.name, Array.from(each.x), Array.from(each.y)])")
    return {name: (np.array(x), np.array(y)) for name, x, y in found}


def wait_for_traces(tab, label, count):
    script = "([label, count]) => (document.querySelector(`[aria-label='${label}']`)?.data ?? []).length >= count"
    tab.wait_for_function(script, arg=[label, count])


def choose(tab, label, option):
    """Choose from a list, which is opened again where the page drew it anew and closed it on the way."""
    wanted, looks = tab.get_by_role("option", name=option, exact=True), itertools.count()

    def shown():
        if not wanted.is_visible() and next(looks) % 100 == 0:
            tab.get_by_label(label, exact=True).click()
        return wanted.is_visible()

    until(tab, shown, f"the option {option}")
    wanted.click()


@pytest.mark.promise("studio-21")
def test_what_is_no_recording_is_refused_in_words(studio, mirror, tmp_path):
    tab, words = mirror, mirror.get_by_role("alert").first
    drop(tab, {"name": "../evil.csv", "mimeType": "text/csv", "buffer": b"1,2\n3,4\n"})
    refusal = "the file '../evil.csv' is not taken: its name holds a path; rename it and drop it again"
    api.expect(words).to_have_text(refusal)
    url = drop(tab, {"name": "<b>no.csv", "mimeType": "text/csv", "buffer": b"PK\x00\x01 not a table"})
    api.expect(words).to_have_text(re.compile(r"^<b>no\.csv: this is a binary file, not text; export the recording"))
    break_off(tab, url)  # which the studio has nothing to say of in the end
    large = tmp_path / "large.csv"
    with large.open("wb") as file:
        file.truncate(300_000_000)  # a hole
    tab.get_by_label("Recordings: drop files here, or choose them").set_input_files(large)
    api.expect(words).to_have_text(
        "the file 'large.csv' has more than 200 MB; cut out the part that you need, keep every n-th sample, or run "
        "microrad identify on the file, which needs no upload"
    )
    assert list((studio.folder / ".microrad-studio" / "uploads").glob("*/*.csv")) == []
    assert not list(studio.folder.glob("*.csv"))


def looped(path, unit, scale=1.0):
    """A recording with a loop of 0.6 mrad, written in another unit."""
    time, drive, angle = np.loadtxt(write_recording(path), delimiter=",", skiprows=1).T
    heads = f"time [s],drive [V],angle [{unit}]"
    np.savetxt(
        path, np.column_stack((time, drive, scale * angle)), delimiter=",", header=heads, comments="", fmt="%.9g"
    )
    return path


def test_each_recording_has_its_own_units_and_one_that_cannot_be_read_says_so(mirror, tmp_path, picture):
    tab = mirror
    for name, unit, scale in (("a_mrad", "mrad", 1.0), ("b_urad", "urad", 1e3)):
        drop(tab, looped(tmp_path / f"{name}.csv", unit, scale))
        api.expect(tab.locator(".mirror-file .seen")).to_have_text(f"{name}.csv")
        api.expect(figure_title(tab, f"output ({unit.replace('urad', 'µrad')})")).to_have_count(2)
    tab.get_by_role("button", name="Identify").click()
    denied = (
        "unit of the output: the form says µrad and a_mrad.csv says mrad; choose what the file says, or set its use"
    )
    api.expect(tab.get_by_role("alert").last).to_contain_text(denied)
    odd = looped(tmp_path / "c_nan.csv", "urad")
    odd.write_text(odd.read_text("utf-8").replace("\n0.009,", "\n0.009,nan,0\n0.010,", 1), "utf-8")
    drop(tab, odd)
    row = tab.locator(".mirror-file", has_text="c_nan.csv")
    fault = row.locator("xpath=following-sibling::*[1]")
    api.expect(fault).to_contain_text("c_nan.csv: ")
    tab.locator(".mirror-file", has_text="a_mrad.csv").get_by_role("button", name="Show").click()
    api.expect(figure_title(tab, "output (mrad)")).to_have_count(2)
    api.expect(tab.locator(".mirror-file .seen")).to_have_text("a_mrad.csv")
    api.expect(fault).to_contain_text("c_nan.csv: ")
    fits(tab, "mirror", picture)
    for name in ("c_nan.csv", "a_mrad.csv", "b_urad.csv"):
        tab.locator(".mirror-file", has_text=name).get_by_role("button", name="Remove").click()
        api.expect(tab.locator(".mirror-file", has_text=name)).to_have_count(0)
        if name == "a_mrad.csv":  # which was shown
            api.expect(figure_title(tab, "output (µrad)")).to_have_count(2)


def figure_title(tab, words):
    return tab.locator(".js-plotly-plot text", has_text=words)


@pytest.mark.promise("readme-15")
@pytest.mark.endurance  # test_studio_bench.py and test_studio_commands.py identify without a browser
def test_a_recording_is_dropped_identified_while_one_looks_on_and_its_mirror_used(studio, opened, recording, picture):
    (file, says), tab = recording, opened("mirror")
    drop(tab, file)
    api.expect(tab.locator(".mirror-file .seen")).to_have_text(file.name)
    api.expect(tab.get_by_role("alert").last).to_contain_text(says["said"])  # the form is full: nothing fills it again
    for label, value in (("Angle or displacement", says["output"]), ("Unit of the output", says["unit"])):
        if value is not None:
            choose(tab, label, value)
    for label, value in (("Sample rate", says["rate"]), ("Lever arm", says["arm"])):
        if value:
            tab.get_by_label(label).fill(value)
    wait_for_traces(tab, "Measured loop: output over drive", 1)
    drive, output = traces(tab, "Measured loop: output over drive")["measured"]
    middle = np.abs(drive - drive.mean()) < 0.05 * np.ptp(drive)
    assert drive.size > 500
    spread, travel = (np.ptp(np.percentile(each, (2, 98))) for each in (output[middle], output))
    assert 0.05 * travel < spread < 0.5 * travel  # the loop is open, and no cloud
    tab.get_by_label("Name of the mirror").fill("stage")
    tab.get_by_text("Hysteresis alone: two models, in seconds").click()
    kept = studio.folder / ".microrad-studio" / "mirror-form.json"
    until(tab, lambda: (kept_form(kept).setting.name, kept_form(kept).setting.static) == ("stage", True), "the form")
    tab.get_by_role("button", name="Identify").click()
    over = tab.get_by_role("link", name="Open the report")  # before the page has looked, on a machine with much to do
    tab.get_by_role("button", name="Cancel").or_(over).first.wait_for()
    picture(tab, "mirror-running.png", full_page=True)
    tab.reload()  # the job and the form outlive the page
    tab.get_by_role("link", name="Open the report").wait_for()
    assert tab.get_by_label("Name of the mirror").input_value() == "stage"
    assert tomllib.loads((studio.folder / "stage.toml").read_text("utf-8"))["name"] == "stage"
    (fitted,) = filter(None, map(read_fits, (studio.folder / ".microrad-studio" / "jobs").glob("[0-9]*")))
    assert {fit.model for fit in fitted} == {"prandtl_ishlinskii", "bouc_wen"}
    tab.get_by_role("cell", name="bouc_wen", exact=True).wait_for()
    chosen = tab.get_by_role("row").filter(has=tab.get_by_text("chosen", exact=True))
    api.expect(chosen).to_have_count(1)
    wait_for_traces(tab, "Measured loop and that of the model", 2)
    fits(tab, "mirror", picture)
    (_, measured), (_, model) = traces(tab, "Measured loop and that of the model").values()
    assert 0 < np.std(measured - model) < 0.05 * np.ptp(measured)
    before = studio.file.read_text("utf-8")
    tab.get_by_role("button", name="Use this mirror in the mission").click()
    tab.get_by_text("[mirror] of the mission names stage.toml now").wait_for()
    draft_is(tab, "not saved")  # it was saved before
    tab.get_by_role("button", name="Save", exact=True).click()
    draft_is(tab, "saved")
    assert tomllib.loads(studio.file.read_text("utf-8"))["mirror"] == {"file": "stage.toml"}
    studio.file.write_text(before, "utf-8")
    mission = opened()
    mission.get_by_role("button", name="Open ...").click()
    mission.get_by_role("dialog").get_by_role("button", name="Open", exact=True).click()
    mission.get_by_role("dialog").wait_for(state="hidden")


def test_a_controller_is_chosen_and_its_loop_answers(opened, picture):
    tab = opened("control")
    choose(tab, "Controller", "PID of [control]")
    tab.get_by_text(re.compile("^Error: with hysteresis")).wait_for()
    rows = tab.get_by_role("row").filter(has_text="PID of [control]").first
    assert re.search(r"0\.\d\d\s", rows.inner_text())
    both = traces(tab, "Step response")
    assert list(both) == ["wanted", "with hysteresis", "without hysteresis"]
    drive = tab.get_by_label("Drive behind a step", exact=True)
    assert "amplifier's limits" in drive.evaluate("plot => plot.layout.shapes.map(each => each.name)")
    tab.get_by_role("button", name="without", exact=True).click()
    tab.wait_for_function("document.querySelector('[aria-label=\"Step response\"]').data.length === 2")
    assert list(traces(tab, "Step response")) == ["wanted", "without hysteresis"]
    tab.get_by_label("Step", exact=True).fill("5 V")
    tab.get_by_text('step: "5 V" is in "V", another kind of quantity').wait_for()
    api.expect(tab.get_by_label("Step response")).to_have_class(re.compile(r"\bbehind\b"))
    tab.get_by_label("Step", exact=True).fill("50 urad")
    api.expect(tab.get_by_label("Step response")).not_to_have_class(re.compile(r"\bbehind\b"))
    assert tab.get_by_text("another kind of quantity").count() == 0
    fits(tab, "control", picture)
