"""From a step of a slider in the studio to the updated margin map in the browser.

    python benchmarks/studio_map.py                # 100 steps by either way in Debian's Chromium
    python benchmarks/studio_map.py --steps 300

The studio runs as a user starts it, as a process of its own, with the paper's mission; the page of the links is open in
Chromium. The slider of the LEO aperture is moved by the arrow keys, one press after the other was drawn, and dragged to
and fro by the mouse without a pause. The clock is the browser's: it starts when the browser takes in the press or the
movement that gives the slider a value, and stops at the frame after plotly has drawn the map of that value. Which value
a map is of is read from its corner and computed again here; values that the mouse leaves behind before they are drawn
do not count. Server and browser work at the same time: two cores are busy.
"""

import argparse
import os
import shutil
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path

from recorded import record

HERE = Path(__file__).resolve().parent
MISSION = HERE.parent / "missions" / "leo-geo.toml"
KEY, SLIDER = "terminals.leo_aperture", "LEO aperture, slider"
MOST_MS = 150.0

DRAWN = "() => document.querySelector('.margin-map')?.data?.[0]?.z"
# What the slider comes to, with the time of the event that did it, and what is drawn, one frame later.
WATCH = """
name => {
  const map = document.querySelector('.margin-map');
  const slider = document.querySelector(`[aria-label='${name}']`);
  let last = 0;
  window.moved = [];
  window.drawn = [];
  for (const each of ['keydown', 'pointermove', 'mousemove'])
    document.addEventListener(each, event => { last = event.timeStamp; }, true);
  new MutationObserver(() => window.moved.push([last, Number(slider.getAttribute('aria-valuenow'))]))
    .observe(slider, { attributeFilter: ['aria-valuenow'] });
  map.on('plotly_afterplot', () => {
    const corner = map.data[0].z[0][0];
    requestAnimationFrame(() => setTimeout(() => window.drawn.push([performance.now(), corner]), 0));
  });
}
"""


def moved_by_keys(page, steps):
    """Move the slider by its arrow keys; each step waits for the map of the one before."""
    page.get_by_role("slider", name=SLIDER).locator("[tabindex='0']").focus()
    for step in range(steps):
        before = page.evaluate("() => window.drawn.at(-1)?.[1] ?? null")
        page.keyboard.press("ArrowRight" if step % 40 < 20 else "ArrowLeft")
        page.wait_for_function("before => (window.drawn.at(-1)?.[1] ?? null) !== before", arg=before, timeout=10_000)


def moved_by_mouse(page, steps):
    """Drag the knob to and fro until so many maps are drawn."""
    box = page.get_by_role("slider", name=SLIDER).bounding_box()
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    page.mouse.move(x, y)
    page.mouse.down()
    for step in range(20 * steps):
        page.mouse.move(x + 0.4 * box["width"] * ((step % 100) / 50.0 - 1.0), y)
        page.wait_for_timeout(16)
        if page.evaluate("() => window.drawn.length") >= steps:
            break
    page.mouse.up()


def latencies_ms(moved, drawn, corner_of):
    """How long each map took that shows another value than the one before: since the slider last came to the value."""
    took, before = [], None
    for when, corner in drawn:
        value = min({value for _, value in moved}, key=lambda value: abs(corner_of[value] - corner))
        if abs(corner_of[value] - corner) > 0.02:
            raise SystemExit(f"a map shows {corner} dB in its corner, which belongs to no position of the slider")
        since = [time for time, position in moved if position == value and time < when]
        if value != before and since:
            took.append(when - since[-1])
        before = value
    return took


def corners_db(positions):
    """What the corner of the map is at each position of the slider, computed here."""
    from microrad.studio.draft.draft import Draft
    from microrad.studio.views import link as link_view
    from microrad.studio.views.sliders import slider

    draft = Draft.open(MISSION)
    frame, slider = link_view.view(draft.link()).frame, slider(draft.values[KEY])
    views = {each: link_view.view(draft.set(KEY, slider.at(each)).link(), frame) for each in positions}
    return {each: float(view.margin_db[0, 0]) for each, view in views.items()}


def measured(url, steps):
    """Milliseconds by each way of moving."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as started:
        browser = started.chromium.launch(executable_path=shutil.which("chromium"), args=["--no-sandbox"])
        page = browser.new_page(viewport={"width": 1400, "height": 900})
        page.goto(url)
        page.get_by_role("link", name="Links").click()
        page.wait_for_function(DRAWN)
        page.get_by_text("The links close: ").wait_for()  # the study of the links, which follows a value at rest
        page.evaluate(WATCH, SLIDER)
        took = {}
        for name, move in (("arrow keys", moved_by_keys), ("mouse, dragged", moved_by_mouse)):
            page.evaluate("() => { window.moved = []; window.drawn = []; }")
            move(page, steps)
            moved, drawn = page.evaluate("() => [window.moved, window.drawn]")
            took[name] = latencies_ms(moved, drawn, corners_db({value for _, value in moved}))
        browser.close()
    return took


def missing():
    """What this needs and does not find, or ""."""
    from importlib.util import find_spec

    names = [name for name in ("nicegui", "playwright") if find_spec(name) is None]
    return ", ".join([*names, *([] if shutil.which("chromium") else ["Chromium"])])


def main():
    """Start the studio, measure, end it."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--steps", type=int, default=100)
    steps = parser.parse_args().steps
    if missing():
        print(f"slider to margin map: skipped, without {missing()}")
        return
    with tempfile.TemporaryDirectory() as folder:
        shutil.copy(MISSION, folder)
        command = [sys.executable, "-m", "microrad", "studio", MISSION.name, "--no-browser"]
        studio = subprocess.Popen(command, cwd=folder, stdout=subprocess.PIPE, text=True)
        try:
            took = measured(studio.stdout.readline().strip(), steps)
        finally:
            studio.terminate()
            studio.wait()
    print(f"{'slider to margin map':22} {'maps':>5} {'median ms':>9} {'90 % ms':>9} {'most ms':>9}")
    for name, each in took.items():
        record(f"slider to margin map, median: {name}", statistics.median(each), "ms", at_most=MOST_MS)
        tenths = statistics.quantiles(each, n=10)
        print(f"{name:22} {len(each):5} {statistics.median(each):9.1f} {tenths[-1]:9.1f} {max(each):9.1f}")
    print(f"on {len(os.sched_getaffinity(0))} cores; the median is to be at most {MOST_MS:.0f} ms")


if __name__ == "__main__":
    main()
