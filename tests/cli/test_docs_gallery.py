"""docs/gallery.md: each example is walked through as it stands, prints what stands there, and has no other figure.

Four of the seven are walked through by `make endurance` alone: the commands and functions in them have tests of
their own.
That of the recorded mirror takes its recordings from the folder that MICRORAD_DATA names; it is walked through once
more with recordings that are made here and a smaller search.
"""

import json
import math
import re
import shlex
import shutil
import subprocess
import sys
import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from microrad import orbit, report
from microrad.core import lti
from microrad.core.units import parse_quantity
from microrad.lab.identify import coupled
from microrad.lab.identify.coupled.ladder import LadderOptions, identify_coupled
from microrad.loop import controller_study, coupled_study
from microrad.mirror.model import linearised
from microrad.mission import presets
from microrad.mission.file import load_link, load_mirror
from microrad.report.identification import page as identification
from microrad.study import study
from places import DATA, ROOT
from scenes import scene_of
from several_axes import three_actuators
from shipped import whole_drawn, whole_study

GALLERY = ROOT / "docs" / "gallery"
PAGE, REPORT = (
    re.sub(r"\s*<!-- promise: .*? -->", "", (ROOT / "docs" / name).read_text(encoding="utf-8"))
    for name in ("gallery.md", "report.md")
)
EXAMPLES = {text.partition("\n")[0]: text.partition("\n")[2] for text in PAGE.split("\n## ")[1:]}
PAPER, LAB, FLIGHT, CHOICE, CROSSLINK, CONSTELLATION, GROUND = EXAMPLES
BLOCK = re.compile(r"(?ms)^```(\w+)\n(.*?)^```|((?:^    \S[^\n]*\n)+)")
FIGURE = re.compile(r"\d+(?:\.\d+)?(?: (?:%|dB|deg|min|h|cm|[µmMkGT]?(?:rad|bit|m|W|V|Hz|s|B))(?:/s)?(?!\w))?")
DERIVED = {
    PAPER: {"0.60 dB": 3.60 - 3.00},
    LAB: {},
    FLIGHT: {},
    CHOICE: {"29 %": 100 * (5.66 / 4.40 - 1.0), "5 %": 100 * 0.05},
    CROSSLINK: {"1081 km": 580 * 10 ** (5.41 / 20), "80 mm": 5 * 16, "0.96 deg/s": math.degrees(16.8e-3)},
    CONSTELLATION: {},
    GROUND: {
        "7.5 dB": 9.04 - (1.22 - 0.06) - (0.52 - 0.18),
        "1.16 dB": 1.22 - 0.06,
        "0.34 dB": 0.52 - 0.18,
        "21.1 dB": 10 * math.log10(68.2e9 / 535e6),
        "5.98 dB": 4.76 + 2.44 - 1.22,
        "11.6 dB": 10 * math.log10((40 / 5 * 5 / 10) ** 2 * (1 - 0.3**2)),  # less the obscuration
        "3.43 dB": 4.58 - 1.15,
        "1.91 dB": 3.29 - 1.38,
        "0.94 dB": 1.40 - 0.46,
        "3.87 dB": -(3.29 - 7.16),
        "1.56 dB": -(1.40 - 2.96),
        "2.9 W": 10 ** ((3 - (1.40 - 2.96)) / 10),
        "4.9 W": 10 ** ((3 - (3.29 - 7.16)) / 10),
        "27 %": 100 * (1 - 141 / 193),
        "14.5 Gbit/s": 14.5 * 1,
        "9.6 TB": 141e-3 * 68.2 / 1,
    },
}
"""What the prose works out from the figures that it shows, as it is written."""
REQUIRED = {"10 µrad", "3 dB"}
GIVEN = {
    PAPER: set(),
    LAB: {*REQUIRED, "40 Hz", "25 Hz"},
    FLIGHT: {"4.0"},  # of the licence
    CHOICE: {*REQUIRED, "99.7 %"},
    CROSSLINK: {"45 deg", "1 deg/s"},
    CONSTELLATION: {"100 Mbit/s", "300 Mbit/s"},
    GROUND: {"300 Mbit/s", "5 deg", "40 cm"},
}
"""What the prose takes from the files."""


WRITTEN = ["contact-plan.ionrc", "figures", "manifest.json", "report.html", "results.nc", "sessions.csv"]


class Walk:
    """An example on its way: what was printed last, and what its Python knows so far."""

    def __init__(self, call, capsys):
        self.call, self.capsys = call, capsys
        self.printed, self.known = "", {}

    def through(self, example):
        for kind, body, commands in BLOCK.findall(example):
            getattr(self, kind or "shell")(body or commands)

    def shell(self, lines):
        """Commands, in this process."""
        self.printed = ""
        for line in lines.splitlines():
            program, *words = shlex.split(line, comments=True)
            assert program == "microrad", line
            done = self.call(*words)
            assert (done.code, done.err) == (0, ""), done
            self.printed += done.out

    def python(self, code):
        exec(code, self.known)
        self.printed = self.capsys.readouterr().out

    def text(self, shown):
        """What was printed, in its order, whatever the line breaks; dots stand for what is left out."""
        rest = " ".join(self.printed.split())
        for part in re.split(r"(?m)^\.\.\.$", shown):
            if wanted := " ".join(part.split()):
                assert wanted in rest, (wanted, self.printed)
                rest = rest.partition(wanted)[2]

    def diff(self, change):
        """A line of a file replaced, which is there once, or lines put behind its last."""
        name, *lines = change.splitlines()
        path = Path(name.removeprefix("--- "))
        old, new = ("".join(f"{line[1:]}\n" for line in lines if line[0] == sign) for sign in "-+")
        text = path.read_text(encoding="utf-8")
        assert text.count(old) == 1 or not old, old
        path.write_text(text.replace(old, new) if old else text + new, encoding="utf-8")


@pytest.fixture
def walk(folder, call, capsys):
    """The project's folder, as far as the examples go into it."""
    shutil.copytree(GALLERY, folder / "docs" / "gallery")
    shutil.copytree(ROOT / "missions", folder / "missions")
    return Walk(call, capsys)


def run_once(monkeypatch):
    """What `reproduce` runs and draws again is what `run` found and drew; tests/test_reproduce.py does it twice."""
    found, drawn, run, write, shipped = {}, [], study.run_study, report.write, whole_study()[0]

    def remembered(file, on_progress, parts=None):
        if file.sha256 not in found:
            same = shipped.file.text == file.text
            found[file.sha256] = replace(shipped, file=file) if same else run(file, on_progress)
        return found[file.sha256]

    def copied(of, target, **settings):
        if not drawn:
            drawn.append(shutil.copytree(write(of, target, **settings).parent, target.parent / "drawn"))
        else:
            shutil.copytree(drawn[0], target)
        return target / "report.html"

    monkeypatch.setattr(study, "run_study", remembered)
    figures = whole_drawn()
    monkeypatch.setattr(report, "study_figures", lambda *args: figures)
    monkeypatch.setattr(report, "write", copied)
    return found


def assumptions_changed(monkeypatch, shown):
    """The day with each of its assumptions changed alone, which takes most of its time, only where that is shown."""
    swings = orbit.day.swings
    monkeypatch.setattr(orbit.day, "swings", lambda known, *args: swings(known, *args) if shown(known) else ())


# ------------------------------------------------------------------------------------------------------------ examples
@pytest.mark.promise(
    "gallery-1", "gallery-2", "gallery-3", "gallery-4", "gallery-5", "report-2", "report-7", "report-13"
)
@pytest.mark.promise("index-1")
@pytest.mark.promise("pointing-97")
def test_the_papers_mission(walk, monkeypatch):
    found = run_once(monkeypatch)
    walk.through(EXAMPLES[PAPER])
    (results,) = re.findall(r"(?ms)^```python$.*?^```$\n\n^```text$.*?^```$", REPORT)
    walk.through(results.replace("leo-geo-study", "paper-study"))
    (ran,) = found.values()
    assert sorted(path.name for path in Path("paper-study").iterdir() if path.stat().st_size) == WRITTEN
    listed = {each.design.name: each for each in ran.fine_pointing.verified}
    alone = controller_study.design_and_simulate_one(scene_of(ran.file), "PI")
    assert alone.simulated["given"].quantile_rad == listed["PI"].simulated["given"].quantile_rad
    assert alone.design.tuned.values == listed["PI"].design.tuned.values != listed["PI + notch"].design.tuned.values
    with pytest.raises(ValueError, match="'PID' is no controller of this mission; it has PI, best"):
        controller_study.design_and_simulate_one(scene_of(ran.file), "PID")


@pytest.mark.promise("gallery-1", "gallery-6", "gallery-7", "gallery-9")
@pytest.mark.endurance
def test_a_lab_identifies_its_mirror(walk, monkeypatch):
    monkeypatch.setattr(
        identification, "identification_figures", lambda *args, **kwargs: {}
    )  # drawing has tests of its own
    walk.through(EXAMPLES[LAB])
    m = walk.known["file"].mission
    assert (m.requirement.pointing_error_rad, m.requirement.margin_db) == (10e-6, 3.0)
    assert m.fine_pointing.quantile == 0.997 == 1.0 - m.requirement.outage
    assert {path.name for path in Path("lab").glob("*.tdms")} >= {"loops-40hz.tdms", "held-out.tdms"}
    assert 'frequencies = ["25 Hz"]' in Path("docs/gallery/lab-plan.toml").read_text(encoding="utf-8")
    assert (GALLERY / "loops.png").stat().st_size < 1e5


@pytest.mark.promise("gallery-1", "gallery-10", "gallery-11", "gallery-12", "gallery-13")
@pytest.mark.promise("pointing-79", "pointing-80", "pointing-92")
@pytest.mark.endurance
def test_a_recorded_mirror_goes_to_flight(walk):
    given = sorted((DATA / "cubespec").glob("*_train.npy"))
    if not given:
        pytest.skip("the recordings of the CubeSpec mirror are not here")
    for path in given:
        shutil.copy(path, path.name)
    walk.through(EXAMPLES[FLIGHT])
    assert_followed(Path("cubespec.toml").resolve())
    assert_recorded(json.loads(Path("leo-geo-study/manifest.json").read_text(encoding="utf-8"))["summary"])


def assert_followed(mirror):
    """A reference of sines on that mirror leaves what docs/pointing.md says, to 5 %: in all, in brackets alone."""
    command = [sys.executable, str(ROOT / "benchmarks" / "feedforward.py"), str(mirror), "50"]
    printed = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    rows = {line[:16].strip(): re.findall(r"[0-9.]+", line[16:]) for line in printed.splitlines()[2:]}
    found = {name: [float(each) for each in cells] for name, cells in rows.items()}  # by itself, in all; five ways
    of_itself, in_all = found["as modelled"][::2], found["as modelled"][1::2]
    assert [in_all[i] for i in (0, 1, 2, 4)] == pytest.approx([17.65, 3.47, 2.31, 2.28], rel=0.05)
    assert [of_itself[i] for i in (0, 1, 2, 4)] == pytest.approx([17.57, 2.55, 0.43, 0.05], rel=0.05, abs=0.01)
    assert [found["gain -20 %"][1::2][i] for i in (2, 1, 4)] == pytest.approx([5.01, 3.29, 4.77], rel=0.05)
    still = float(re.search(r"without a reference: ([0-9.]+) µrad", printed)[1])
    assert still == pytest.approx(2.35, rel=0.05)


def assert_recorded(summary):
    """What each controller leaves on that mirror is what docs/pointing.md records of it, to 5 %."""
    page = (ROOT / "docs" / "pointing.md").read_text(encoding="utf-8")
    table = page[page.index("| | linear, radial | simulated with hysteresis, x / y |") :].partition("\n\n")[0]
    found = {each["name"]: each for each in summary["fine_pointing"]["controllers"]}
    rows = [re.split(r" *\| *", line)[1:-1] for line in table.splitlines()[2:]]
    assert len(rows) == 5
    angles = [
        sorted(math.degrees(p["value"]) for p in found[name]["parameters"] if p["name"].startswith("direction"))
        for name in ("PI", "PI + notch", "disturbance observer")
    ]
    assert angles == [pytest.approx([-60.1, 52.2], abs=1.0)] * 3
    for name, linear, by_axis, quantile, disk in rows:
        given = found[name]["simulated"]["given"]
        assert 1e6 * found[name]["theory_rms_rad"] == pytest.approx(float(linear), rel=0.05)
        assert [1e6 * rad for rad in given["axis_rms_rad"]] == pytest.approx(
            [float(each) for each in by_axis.split(" / ")], rel=0.05
        )
        assert 1e6 * given["quantile_rad"] == pytest.approx(float(quantile), rel=0.05)
        assert found[name]["margins"]["disk"] == pytest.approx(float(disk), abs=0.03)
        assert 0.5 <= found[name]["margins"]["modulus"] < 0.51


@pytest.mark.promise("gallery-11", "gallery-13")
@pytest.mark.endurance
def test_a_made_up_mirror_goes_to_flight(walk, monkeypatch, undrawn):
    """The same commands with recordings of a plate on three actuators, a linear model and one controller."""

    def short(*args, **options):
        return identify_coupled(*args, options=LadderOptions(axis_orders=(2,), linear_orders=(6,)), **options)

    monkeypatch.setattr(coupled, "identify_coupled", short)
    monkeypatch.setattr("microrad.report.identification.coupled.coupled_figures", lambda found: {})
    monkeypatch.setattr(coupled_study.designs, "names", lambda table: ("PI",))
    monkeypatch.setattr(study.paper, "applies", lambda mission: False)
    for number, amplitude in enumerate((100, 200, 300)):
        drive, output = played(amplitude, seed=number)
        np.save(f"u_{amplitude}mV_train.npy", drive)
        np.save(f"y_{amplitude}mV_train.npy", output)
    commands = re.sub(r"(?ms)^```text\n.*?^```\n", "", EXAMPLES[FLIGHT]).replace("--controller LQG", "--controller PI")
    walk.through(commands)
    assert "compiled, run 5000 samples of the loop: at most" in walk.printed
    manifest = json.loads(Path("leo-geo-study/manifest.json").read_text(encoding="utf-8"))
    assert manifest["mission"]["file"] == "leo-geo.toml"
    assert "fine pointing at 99.7 % (PI)" in Path("leo-geo-study/report.html").read_text(encoding="utf-8")


def played(amplitude_mv, seed, samples=512, realisations=4):
    """Multisines on the actuators of the plate, and its sensors: (samples, channels, realisations, periods)."""
    rng = np.random.Generator(np.random.Philox(seed))
    lines, spectrum = np.arange(1, samples // 3), np.zeros((samples // 2 + 1, 3, realisations), dtype=complex)
    spectrum[lines] = np.exp(2j * np.pi * rng.random((lines.size, 3, realisations)))
    drive = np.fft.irfft(spectrum, samples, axis=0)
    drive *= 1e-3 * amplitude_mv / drive.std()
    m = linearised(three_actuators().mirror, [0.9, 0.9, 0.9])
    freq_hz = np.arange(samples // 2 + 1) * 6400.0 / samples / 4.0  # four times as stiff
    response = lti.frequency_response(lti.StateSpace(m.A, m.B, m.C, m.D), freq_hz)
    moved = np.fft.irfft(np.einsum("foi,fir->for", response, np.fft.rfft(drive, axis=0)), samples, axis=0)
    noise = 1e-3 * moved.std() * rng.standard_normal((*moved.shape, 2))
    return np.repeat(drive[..., None], 2, axis=3), moved[..., None] + noise


@pytest.mark.promise("gallery-1", "gallery-15", "gallery-16")
@pytest.mark.endurance
def test_choosing_a_mirror(walk):
    walk.through(EXAMPLES[CHOICE])


@pytest.mark.promise("gallery-1", "gallery-17", "gallery-18", "gallery-19", "gallery-20")
def test_a_crosslink(walk, monkeypatch):
    assert "each assumption changed alone" not in EXAMPLES[CROSSLINK]
    assumptions_changed(monkeypatch, shown=lambda known: False)
    walk.through(EXAMPLES[CROSSLINK])
    found = json.loads(walk.call("contacts", "docs/gallery/crosslink.toml", "--json").out)["contacts"]
    ends = [(each["begins"].partition(" ")[0], each["ends"].partition(" ")[0]) for each in found]
    assert ends == [*([("Earth", "Sun"), ("Sun", "Earth")] * 8)[:-1], ("Sun", "end")]  # of the span
    rises_s = [each["start_s"] for each in found[::2]]
    radius_m = 6378137.0 + load_link(GALLERY / "crosslink.toml").mission.orbit.leo.altitude_m
    half_orbit_s = math.pi * math.sqrt(radius_m**3 / 3.986004418e14)
    assert np.diff(rises_s) == pytest.approx(half_orbit_s, rel=0.01)


@pytest.mark.promise("gallery-1", "gallery-21", "gallery-22", "gallery-23", "gallery-24")
@pytest.mark.endurance
def test_a_constellations_day(walk):
    walk.through(EXAMPLES[CONSTELLATION])
    for rate in GIVEN[CONSTELLATION]:
        assert f'"{rate}"' in re.search(r"(?m)^# rates = .*$", walk.known["text"])[0]


@pytest.mark.promise("gallery-1", "gallery-26", "gallery-27", "gallery-28", "gallery-29", "gallery-30", "gallery-31")
@pytest.mark.promise("gallery-32", "gallery-33", "gallery-34", "gallery-35", "gallery-37", "gallery-38", "gallery-39")
def test_down_to_the_ground_or_up_to_the_relay(walk, monkeypatch):
    monkeypatch.setenv("COLUMNS", "120")  # as wide as the page
    assert "each assumption changed alone" in EXAMPLES[GROUND].rpartition("    microrad contacts leo-geo.toml\n")[2]
    assert EXAMPLES[GROUND].count("each assumption changed alone") == 1
    assumptions_changed(monkeypatch, shown=lambda known: len(known.own.operations.optical.stations) == 4)
    walk.through(EXAMPLES[GROUND])
    m = load_link(Path("leo-geo.toml")).mission
    assert {f"{m.communication.data_rate_bit_s / 1e6:g} Mbit/s"} <= GIVEN[GROUND]
    (kiruna,) = m.operations.downlink.stations.values()
    assert f"{math.degrees(kiruna.mask_rad):g} deg" in GIVEN[GROUND]


@pytest.mark.promise("gallery-1")
def test_four_examples_wait_for_endurance():
    text = Path(__file__).read_text(encoding="utf-8")
    waiting = re.findall(r"@pytest\.mark\.endurance\n(?:@.*\n)*def (test_\w+)\(", text)
    walks = dict(re.findall(r"(?m)^def (test_\w+)\(walk.*\n(?:    .*\n|\n)*?    .*?EXAMPLES\[(\w+)\]", text))
    assert len(set(walks.values())) == len(EXAMPLES) == 7
    assert {walks[name] for name in waiting} == {"LAB", "FLIGHT", "CHOICE", "CONSTELLATION"}
    assert {walks[name] for name in walks.keys() - set(waiting)} == {"PAPER", "CROSSLINK", "GROUND"}
    assert "(four of them in `make endurance` alone" in " ".join(PAGE.split())


@pytest.mark.promise("readme-6")
def test_the_questions_are_those_of_the_readme():
    text = " ".join((ROOT / "README.md").read_text(encoding="utf-8").split())
    said = re.search(r"works seven questions from the first command to what to do about the answer: (.*?)\.", text)[1]
    asked = ", ".join(title[:1].lower() + title[1:] for title in EXAMPLES)
    asked = asked.replace("ground, or up to the relay?", "ground or up to the relay")
    assert PAGE.partition("\n\n")[2].startswith("Seven questions") and len(EXAMPLES) == 7
    words = [
        re.sub(r"^(a|an|the) ", "", each.replace("does the paper's mission close", "paper's mission: does it close?"))
        for each in said.split(", ")
    ]
    assert words == [re.sub(r"^(a|an|the) ", "", each) for each in asked.split(", ")]


# --------------------------------------------------------------------------------------------------------- the figures
@pytest.mark.promise(
    "gallery-1",
    "gallery-3",
    "gallery-4",
    "gallery-7",
    "gallery-9",
    "gallery-12",
    "gallery-15",
    "gallery-16",
    "gallery-19",
    "gallery-20",
    "gallery-21",
    "gallery-22",
)
@pytest.mark.parametrize("title", EXAMPLES)
def test_the_prose_has_no_figure_of_its_own(title):
    blocks = " ".join("".join(found) for found in BLOCK.findall(EXAMPLES[title]))
    prose = re.sub(r"(?m)^\|.*$|\]\([^)]*\)", "", BLOCK.sub("", EXAMPLES[title]))
    alone = set(FIGURE.findall(" ".join(prose.split()))) - set(FIGURE.findall(blocks))
    assert alone == DERIVED[title].keys() | GIVEN[title]
    for written, value in DERIVED[title].items():
        digits, _, unit = written.partition(" ")
        assert f"{value:.{len(digits.partition('.')[2])}f} {unit}" == written


@pytest.mark.promise("gallery-14", "gallery-25")
def test_the_table_of_mirrors_is_that_of_their_files():
    rows = re.findall(r"(?m)^\| \[([\w-]+\.toml)\]\S+ \| (.*?) \| (.*?) \| (\d+) % \|$", EXAMPLES[CHOICE])
    assert sorted(name for name, *_ in rows) == sorted(path.name for path in GALLERY.glob("*-stroke.toml"))
    for name, travel, resonance, hysteresis in rows:
        m = load_mirror(GALLERY / name).mirror
        assert m.travel_rad == pytest.approx(parse_quantity(travel, "rad"))
        assert m.linear.poles_hz[0] == pytest.approx(parse_quantity(resonance, "Hz"))
        weights = m.prandtl_ishlinskii.weights_rad_v
        assert 100 * (1.0 - weights[0] / sum(weights)) == pytest.approx(float(hysteresis), abs=0.5)
    asked = load_link(ROOT / "missions" / "paper.toml").mission.requirement
    assert (asked.pointing_error_rad, asked.margin_db, asked.outage) == (10e-6, 3.0, 0.003)
    assert "asks for 10 µrad at 99.7 % of the time and 3 dB" in EXAMPLES[CHOICE]


@pytest.mark.parametrize(("damping", "count"), [(-1.0, 1), (-0.5, 2)])
def test_a_mirror_may_have_a_zero_in_the_right_half_plane(tmp_path, damping, count):
    """As the identified one has it: a real zero counts once against the two poles, one that oscillates twice."""
    text = (GALLERY / "medium-stroke.toml").read_text(encoding="utf-8")
    zero = f'[linear]\nzeros = ["20 kHz"]\nzero_dampings = [{damping}]\n'
    path = tmp_path / "mirror.toml"
    path.write_text(text.replace("[linear]\n", zero), encoding="utf-8")
    if count == 1:
        zeros, _ = load_mirror(path).mirror.linear.roots
        assert zeros == pytest.approx((2 * math.pi * 20e3,))
    else:
        with pytest.raises(ValueError, match="makes 2 zeros over 2 poles"):
            load_mirror(path)


@pytest.mark.promise("gallery-17")
def test_the_crosslink_keeps_all_that_its_preset_knows():
    file = load_link(GALLERY / "crosslink.toml")
    m, given = file.mission, file.sources
    lines = re.findall(r"(?m)^(\w+ = (?!\"unknown\").*)$", presets.preset_text("click"))
    assert len(lines) > 25
    text = (GALLERY / "crosslink.toml").read_text(encoding="utf-8").splitlines()
    assert {line for line in lines if line not in text} == {
        line for line in lines if line.startswith(("name = ", "leo_name = ", "geo_name = "))
    }
    (click,) = (each for each in presets.presets() if each.name == "click")
    assert {given[key].comment.partition(":")[0] for key in click.unknown} == {"example"}
    ends = m.orbit.leo, m.orbit.geo
    apart, slewing = ends[1].node_rad - ends[0].node_rad, {end.limits.slew_limit_rad_s for end in ends}
    assert {f"{math.degrees(apart):g} deg", *(f"{math.degrees(each):g} deg/s" for each in slewing)} == GIVEN[CROSSLINK]


@pytest.mark.promise("gallery-29", "gallery-30")
def test_the_uplink_is_the_downlink_the_other_way():
    up = tomllib.loads((GALLERY / "ground-uplink.toml").read_text(encoding="utf-8"))
    down = tomllib.loads(presets.preset_text("ground-downlink"))
    assert [up[each] for each in ("channel", "jitter", "conventions", "requirement")] == [
        down[each] for each in ("channel", "jitter", "conventions", "requirement")
    ]
    assert (up["orbit"].pop("leo"), up["orbit"].pop("geo")) == (down["orbit"].pop("geo"), down["orbit"].pop("leo"))
    assert up["orbit"] == down["orbit"]
    assert up["communication"].pop("data_rate") == "500 Mbit/s"
    assert down["communication"].pop("data_rate") == "10 Gbit/s"
    assert up["communication"] == down["communication"]
    ends = [[each["terminals"][end] for end in ("leo_aperture", "geo_aperture")] for each in (up, down)]
    assert ends == [["10 cm", "5 cm"], ["5 cm", "40 cm"]] and "40 cm" in GIVEN[GROUND]
    assert down["terminals"]["geo_obscuration"] == 0.3


@pytest.mark.promise("gallery-36")
def test_the_table_of_ways_is_what_the_runs_print():
    runs = [" ".join(run.split()) for run in EXAMPLES[GROUND].split("    microrad contacts leo-geo.toml\n")[1:]]
    late = "half arrives within (.*?), and 99 % within (.*?)[;.,] "
    relay = rf"relay is in view 15 times, (.*?) in all, and could carry (.*?)\. .*()by the relay {late}"
    radio = rf"is in view 10 times, (.*?) in all, and could carry (.*?); .*()by the direct downlink {late}"
    optical = rf"in use for (.*?), and could carry (.*?), .*? clear for (.*?) of .*by the optical downlink {late}"
    shown = [relay, runs[0]], [radio, runs[0]], *([optical, run] for run in runs)
    rows = re.findall(r"(?m)^\| \w+,? .*\d \w+ \|$", EXAMPLES[GROUND])
    assert [re.split(r" *\| *", row)[2:-1] for row in rows] == [
        list(re.search(pattern, run).groups()) for pattern, run in shown
    ]
