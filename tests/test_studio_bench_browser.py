"""The pages on mirror and control in Debian's Chromium: a recording dropped, its loop, a live fit, a chosen controller.

The recording is the real one of 1 Hz where it is present, else one of the virtual bench. Screenshots go to the folder
that MICRORAD_SCREENSHOTS names, else to a temporary one of pytest.
"""

import os
import re
import shutil
import signal
import subprocess
import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest

from microrad import bench
from microrad.studio.live_fit import read_fits
from shipped import SHIPPED

pytest.importorskip("nicegui", reason="the studio is not installed (nicegui)")
api = pytest.importorskip("playwright.sync_api", reason="Playwright is not installed")

REAL = (
    Path(os.environ.get("MICRORAD_DATA") or Path(__file__).parents[2] / "shared" / "data") / "piezo_1hz/Model_Vi_Do.dat"
)

pytestmark = pytest.mark.long
LONG_MS = 45_000  # a machine with other work to do


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    """The file to drop, and what the form has to say of it."""
    if REAL.exists():
        return REAL, {"output": "column 4", "unit": "µm", "rate": "200 Hz", "arm": "50 mm"}
    folder = tmp_path_factory.mktemp("bench") / "played"
    files = bench.write(bench.load_plan("paper-experiment"), folder, 0, False, lambda done, total, what: None)
    loop = next(path for path in files if path.stem == "loop-100hz")
    return loop, {"output": None, "unit": None, "rate": "", "arm": ""}


@pytest.fixture(scope="module")
def studio(tmp_path_factory):
    folder = tmp_path_factory.mktemp("studio")
    (folder / "leo-geo.toml").write_bytes(SHIPPED.read_bytes())
    process = subprocess.Popen(
        [sys.executable, "-m", "microrad", "studio", "leo-geo.toml", "--no-browser"],
        cwd=folder,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    url = process.stdout.readline().strip()
    if not url:
        pytest.fail(f"the studio did not start: {process.communicate()[1]}")
    yield folder, url
    process.send_signal(signal.SIGINT)
    _, err = process.communicate(timeout=60)
    assert (process.returncode, err) == (0, "")


@pytest.fixture(scope="module")
def pictures(tmp_path_factory):
    named = os.environ.get("MICRORAD_SCREENSHOTS")
    folder = Path(named) if named else tmp_path_factory.mktemp("screenshots")
    folder.mkdir(parents=True, exist_ok=True)
    return folder


@pytest.fixture(scope="module")
def context():
    program = shutil.which("chromium")
    if program is None:
        pytest.skip("Chromium is not installed")
    with api.sync_playwright() as play:
        browser = play.chromium.launch(executable_path=program, args=["--no-sandbox"])
        yield browser.new_context(viewport={"width": 1400, "height": 1000})
        browser.close()


@pytest.fixture
def tab(studio, context):
    """A tab that has shown the token; it must complain of nothing and ask nobody else."""
    page, complaints, asked = context.new_page(), [], []
    page.set_default_timeout(LONG_MS)
    page.on("console", lambda m: complaints.append(m.text) if m.type in ("error", "warning") else None)
    page.on("pageerror", lambda error: complaints.append(str(error)))
    page.on("request", lambda request: asked.append(request.url))
    page.goto(studio[1])
    yield page
    page.close()
    assert complaints == []
    assert len(asked) > 5
    assert [
        url for url in asked if not re.match(r"(http|ws)://127\.0\.0\.1:|data:|blob:http://127\.0\.0\.1:", url)
    ] == []


def opened(tab, name):
    tab.goto(tab.url.split("/", 3)[0] + "//" + tab.url.split("/")[2] + f"/{name}")
    tab.get_by_role("heading", name=name.capitalize(), level=1).wait_for()


def drop(tab, file):
    with tab.expect_response(lambda answer: "/upload/" in answer.url):
        tab.get_by_label("Recordings: drop files here, or choose them").set_input_files(file)


def traces(tab, label):
    """The lines of a plot, by name."""
    figure = tab.get_by_label(label, exact=True)
    found = figure.evaluate("plot => plot.data.map(each => [each.name, Array.from(each.x), Array.from(each.y)])")
    return {name: (np.array(x), np.array(y)) for name, x, y in found}


def wait_for_traces(tab, label, count):
    script = "([label, count]) => (document.querySelector(`[aria-label='${label}']`)?.data ?? []).length >= count"
    tab.wait_for_function(script, arg=[label, count])


def choose(tab, label, option):
    tab.get_by_label(label, exact=True).click()
    tab.get_by_role("option", name=option, exact=True).click()


def test_what_is_no_recording_is_refused_in_words(tab, studio):
    opened(tab, "mirror")
    words = tab.get_by_role("alert").first
    drop(tab, {"name": "../evil.csv", "mimeType": "text/csv", "buffer": b"1,2\n3,4\n"})
    refusal = "the file '../evil.csv' is not taken: its name holds a path; rename it and drop it again"
    api.expect(words).to_have_text(refusal)
    drop(tab, {"name": "<b>no.csv", "mimeType": "text/csv", "buffer": b"PK\x00\x01 not a table"})
    api.expect(words).to_have_text(re.compile(r"^<b>no\.csv: this is a binary file, not text; export the recording"))
    assert list((studio[0] / ".microrad-studio" / "uploads").glob("*/*.csv")) == []
    assert not list(studio[0].glob("*.csv"))


def test_a_recording_is_dropped_and_identified_while_one_looks_on(tab, studio, recording, pictures):
    folder, (file, says) = studio[0], recording
    opened(tab, "mirror")
    drop(tab, file)
    tab.get_by_text(file.name, exact=True).wait_for()
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
    tab.wait_for_timeout(1000)  # what is typed is kept behind a short pause
    tab.get_by_role("button", name="Identify").click()
    tab.get_by_role("button", name="Cancel").wait_for()
    tab.screenshot(path=pictures / "mirror-running.png", full_page=True)
    tab.reload()  # the job and the form outlive the page
    tab.get_by_role("link", name="Open the report").wait_for()
    assert tab.get_by_label("Name of the mirror").input_value() == "stage"
    assert tomllib.loads((folder / "stage.toml").read_text("utf-8"))["name"] == "stage"
    fits = read_fits(folder / ".microrad-studio" / "jobs" / "1")
    assert {fit.model for fit in fits} == {"prandtl_ishlinskii", "bouc_wen"}
    tab.get_by_role("cell", name="bouc_wen", exact=True).wait_for()
    chosen = tab.get_by_role("row").filter(has=tab.get_by_text("chosen", exact=True))
    api.expect(chosen).to_have_count(1)
    wait_for_traces(tab, "Measured loop and that of the model", 2)
    tab.wait_for_timeout(500)
    tab.screenshot(path=pictures / "mirror-identified.png", full_page=True)
    (_, measured), (_, model) = traces(tab, "Measured loop and that of the model").values()
    assert 0 < np.std(measured - model) < 0.05 * np.ptp(measured)


def test_the_mirror_goes_into_the_mission(tab, studio):
    folder = studio[0]
    opened(tab, "mirror")
    tab.get_by_role("button", name="Use this mirror in the mission").click()
    tab.get_by_text("[mirror] of the mission names stage.toml now").wait_for()
    tab.get_by_role("button", name="Save", exact=True).click()
    api.expect(tab.get_by_text("saved", exact=False).first).to_be_visible()
    tab.wait_for_timeout(1000)
    assert tomllib.loads((folder / "leo-geo.toml").read_text("utf-8"))["mirror"] == {"file": "stage.toml"}
    (folder / "leo-geo.toml").write_bytes(SHIPPED.read_bytes())


def test_a_controller_is_chosen_and_its_loop_answers(tab, pictures):
    opened(tab, "control")
    choose(tab, "Controller", "PID of [control]")
    tab.get_by_text(re.compile("^Error: with hysteresis")).wait_for()
    rows = tab.get_by_role("row").filter(has_text="PID of [control]").first
    assert re.search(r"0\.\d{3}", rows.inner_text())
    both = traces(tab, "Step response")
    assert list(both) == ["wanted", "with hysteresis", "without hysteresis"]
    assert "amplifier's limits" in traces(tab, "Drive behind a step")
    tab.get_by_role("button", name="without", exact=True).click()
    tab.wait_for_function("document.querySelector('[aria-label=\"Step response\"]').data.length === 2")
    assert list(traces(tab, "Step response")) == ["wanted", "without hysteresis"]
    tab.get_by_label("Step", exact=True).fill("5 V")
    tab.get_by_text('step: "5 V" is in "V", another kind of quantity').wait_for()
    tab.screenshot(path=pictures / "control.png", full_page=True)
