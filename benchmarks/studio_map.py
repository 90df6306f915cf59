"""From a step of a slider in the studio to the updated margin map in the browser, and to the margin beside it.

    python benchmarks/studio_map.py                # 60 steps in Debian's Chromium
    python benchmarks/studio_map.py --steps 200

The studio runs as a user starts it, as a process of its own, with the paper's mission; the page of the links is open in
Chromium. The slider of the LEO aperture is moved by the arrow keys, and by the mouse. The clock is the browser's: from
the event of the key or the pointer to the frame after plotly has drawn the map of that value. Both keep the two cores
busy: server and browser.
"""

import argparse
import shutil
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path

HERE = Path(__file__).resolve().parent
MISSION = HERE.parent / "missions" / "leo-geo.toml"
CHROMIUM = "/usr/bin/chromium"
SLIDER = "LEO aperture, slider"
MOST_MS = 150.0

DRAWN = "() => document.querySelector('.margin-map')?.on && document.querySelector('.margin-map').data?.[0]?.z"
# Each event of input begins a measurement; the first drawing of another map ends it, one frame later.
WATCH = """
() => {
  const map = document.querySelector('.margin-map');
  const z = () => map.data?.[0]?.z?.[0]?.[0];
  window.took = [];
  let begun = null, before = null;
  const begin = () => { begun = performance.now(); before = z(); };
  document.addEventListener('keydown', begin, true);
  document.addEventListener('pointermove', e => { if (e.buttons && begun === null) begin(); }, true);
  map.on('plotly_afterplot', () => {
    if (begun === null || z() === before) return;
    const since = begun;
    begun = null;
    requestAnimationFrame(() => setTimeout(() => window.took.push(performance.now() - since), 0));
  });
}
"""


def moved_by_keys(page, steps):
    """Milliseconds of each step by an arrow key, one after the other."""
    page.evaluate("() => { window.took = []; }")
    page.get_by_role("slider", name=SLIDER).locator("[tabindex='0']").focus()
    for step in range(steps):
        page.keyboard.press("ArrowRight" if step % 40 < 20 else "ArrowLeft")
        page.wait_for_function("n => window.took.length >= n", arg=step + 1, timeout=10_000)
    return page.evaluate("() => window.took")


def moved_by_mouse(page, steps):
    """Milliseconds while the knob is dragged to and fro without a pause: a step begins where the last was drawn."""
    page.evaluate("() => { window.took = []; }")
    box = page.get_by_role("slider", name=SLIDER).bounding_box()
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    page.mouse.move(x, y)
    page.mouse.down()
    for step in range(10 * steps):
        page.mouse.move(x + 0.4 * box["width"] * ((step % 100) / 50.0 - 1.0), y)
        page.wait_for_timeout(16)
        if page.evaluate("() => window.took.length") >= steps:
            break
    page.mouse.up()
    return page.evaluate("() => window.took")


def told(name, took):
    """One line of the table."""
    ranked = sorted(took)
    p90 = ranked[int(0.9 * (len(ranked) - 1))]
    print(f"{name:22} {len(took):5} {statistics.median(took):9.1f} {p90:9.1f} {ranked[-1]:9.1f}")


def measured(url, steps):
    """The table of one browser."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as started:
        browser = started.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        page = browser.new_page(viewport={"width": 1400, "height": 900})
        page.goto(url)
        page.get_by_role("link", name="Links").click()
        page.wait_for_function(
            "() => document.querySelector('.margin-map')?.on && document.querySelector('.margin-map').data?.[0]?.z"
        )
        page.wait_for_timeout(4000)  # the study of the links, which follows each value that is let go
        page.evaluate(WATCH)
        print(f"{'slider to map':22} {'steps':>5} {'median ms':>9} {'90 % ms':>9} {'most ms':>9}")
        keys = moved_by_keys(page, steps)
        told("arrow keys", keys)
        told("mouse, dragged", moved_by_mouse(page, steps))
        browser.close()
    return statistics.median(keys)


def main():
    """Start the studio, measure, end it."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--steps", type=int, default=60)
    steps = parser.parse_args().steps
    with tempfile.TemporaryDirectory() as folder:
        shutil.copy(MISSION, folder)
        command = [sys.executable, "-m", "microrad", "studio", MISSION.name, "--no-browser"]
        studio = subprocess.Popen(command, cwd=folder, stdout=subprocess.PIPE, text=True)
        try:
            median = measured(studio.stdout.readline().strip(), steps)
        finally:
            studio.terminate()
            studio.wait()
    print(f"median by the arrow keys: {median:.0f} ms (at most {MOST_MS:.0f} ms wanted)")


if __name__ == "__main__":
    main()
