"""The laboratory, word for word: recordings unlike each other, what is refused of them and what is fitted to them.

The recordings are made here, from seeds: a mirror with play operators, a resonance and noise, which no model fits
exactly. They are printed to six digits, so that no processor's sine moves them.
"""

import json
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray
from scipy import signal
from scipy.io import savemat
from scipy.signal import cont2discrete, lfilter

from reference import told
from reference.cases import Case, Place, changed

Floats = NDArray[np.float64]

LIBRARY = Path(__file__).with_name("library.py")
"""The program that calls public functions in a case's folder."""

ACCEPTABLE = ("jitter", "clipping", "dead", "quantisation", "drift", "unexcited", "lead")
"""Findings that can be taken on."""

RATE = 1730.0
"""Samples per second where a recording has no rate of its own."""


# ---------------------------------------------------------------------------------------------------------- recordings
def times(samples: int, rate: float = RATE) -> Floats:
    """Times of samples, in s."""
    return np.arange(samples) / rate


def sines(t: Floats, middle: float = 4.3, amplitude: float = 2.9, frequency: float = 7.3) -> Floats:
    """A drive of two sines, whose amplitude grows over the first half, in V."""
    growth = np.minimum(0.4 + 1.2 * t / t[-1], 1.0)
    return middle + growth * amplitude * np.sin(2 * np.pi * frequency * t) + 0.4 * np.sin(2 * np.pi * 1.9 * t + 0.3)


def chirp(t: Floats, first: float = 1.7, last: float = 480.0, middle: float = 4.1, amplitude: float = 0.41) -> Floats:
    """A drive whose frequency grows exponentially, in V."""
    growth = np.log(last / first) / t[-1]
    return middle + amplitude * np.sin(2 * np.pi * first * np.expm1(growth * t) / growth)


def noise(samples: int, seed: int, size: float = 1.0) -> Floats:
    """Normal random numbers."""
    return size * np.random.Generator(np.random.PCG64(seed)).standard_normal(samples)


def plays(drive: Floats, gains: Mapping[float, float]) -> Floats:
    """The sum of play operators from rest at 0, their gains by their thresholds."""
    thresholds, weights = np.array(list(gains)), np.array(list(gains.values()))
    state, found = np.zeros(thresholds.size), np.empty(drive.size)
    for i, u in enumerate(drive):
        state = np.clip(state, u - thresholds, u + thresholds)
        found[i] = state @ weights
    return found


def resonance(values: Floats, frequency: float = 211.0, damping: float = 0.08, rate: float = RATE) -> Floats:
    """A second-order low-pass of gain 1, its input held over each sample."""
    w = 2 * np.pi * frequency
    (numerator,), denominator, _ = cont2discrete(([w**2], [1.0, 2 * damping * w, w**2]), 1 / rate)
    return lfilter(numerator, denominator, values)


GAINS = {0.0: 0.061, 0.31: 0.009, 1.17: 0.011, 2.6: 0.007}
"""Of the mirror in mrad/V, by the thresholds of its plays in V."""


def mirror(drive: Floats, seed: int, rate: float = RATE, rest: float = 4.2, scatter: float = 2e-4) -> Floats:
    """The angle of a mirror in mrad, about an offset, with noise."""
    angle = resonance(plays(drive - rest, GAINS), rate=rate)
    return 0.131 + angle + noise(drive.size, seed, scatter)


def table(columns: Mapping[str, Floats], separator: str = ",", digits: int = 6) -> str:
    """Columns as text, under their names."""
    rows = zip(*(values.tolist() for values in columns.values()), strict=True)
    lines = [separator.join(columns), *(separator.join(f"{each:.{digits}g}" for each in row) for row in rows)]
    return "\n".join(lines) + "\n"


# -------------------------------------------------------------------------------------------------------------- checks
def quantised(values: Floats, step: float) -> Floats:
    """As a converter of this step gives it."""
    return np.round(values / step) * step


def doubtful() -> dict[str, tuple[dict[str, Floats], dict[str, Any]]]:
    """Recordings with something to be found in each, and what is said to read them."""
    t = times(2350)
    u = sines(t)
    y = mirror(u, 11)
    quiet = mirror(u, 12, scatter=0.0)
    smooth = 0.13 + 0.07 * resonance(u - 4.3) + noise(t.size, 23, 1e-4)
    broad, odd = chirp(times(3100)), lines(0, 7)[:, 0]
    follows = mirror(broad, 13, scatter=1e-5)
    clock = t + 0.37
    dice = noise(t.size, 14)
    fast = 3.7 + 0.31 * noise(t.size, 19)
    one = {"inputs": "u", "outputs": "y", "rate_hz": RATE}
    timed = {"inputs": "u", "outputs": "y"}
    pairs: dict[str, tuple[Floats, Floats]] = {
        "fine": (u, y),
        "drive-of-few-levels": (quantised(u, 0.021), y),
        "levels-refused": (u, quantised(quiet, 0.0147)),
        "levels-noted": (u, quantised(quiet, 0.0029)),
        "levels-dithered": (u, quantised(quiet + 0.013 * dice, 0.0147)),
        "levels-of-a-stepping-drive": (quantised(u, 0.97), quantised(0.08 * quantised(u, 0.97), 0.0147)),
        "drift-noted": (u, smooth + 0.017 * t),
        "drift-falls": (u, smooth - 0.011 * t),
        "drift-refused": (u, y - 0.9 * t),
        "drift-of-a-step": (
            np.where(t < 0.1, 1.3, 4.9),
            0.07 * np.where(t < 0.1, 1.3, 6.1 - 1.9 * np.exp(0.1 - t)) + 1e-4 * dice,
        ),
        "clipped-high": (u, np.minimum(quiet, 0.29)),
        "clipped-low": (u, np.maximum(quiet, -0.03)),
        "clipped-drive": (np.clip(u, 2.1, 6.3), mirror(np.clip(u, 2.1, 6.3), 15)),
        "clipped-pile": (fast, np.clip(0.07 * fast, 0.231, 0.2805)),
        "resting-at-its-limit": (
            np.clip(2.9 * u - 8.0, 1.1, 7.7),
            mirror(np.clip(2.9 * u - 8.0, 1.1, 7.7), 16, scatter=0.0),
        ),
        "dead": (broad, noise(broad.size, 17, 0.01)),
        "swapped": (follows, broad),
        "leads": (broad[:-3], 0.07 * broad[3:]),
        "leads-upside-down": (broad[:-2], -0.07 * broad[2:]),
        "leads-narrow": (u[:-4], 0.07 * u[4:]),
        "behind-a-high-pass": (
            odd,
            lfilter([1.0, -1.0], [1.0, -0.99], 0.07 * (odd - odd.mean())) + noise(odd.size, 18, 1e-5),
        ),
        "flicker": (4.7 + 1e-5 * dice, y),
        "short": (u[:187], y[:187]),
        "drive-constant": (np.full(t.size, 4.7), y),
        "output-constant": (u, np.full(t.size, -0.21)),
        "nan": (u, np.where(np.arange(t.size) == 1234, np.nan, y)),
        "infinite": (np.where(np.arange(t.size) == 777, -np.inf, u), y),
        "huge": (u, np.where(np.arange(t.size) == 321, -3.1e31, y)),
        "tiny": (1e-33 * u, y),
    }
    found = {name: ({"u": drive, "y": output}, one) for name, (drive, output) in pairs.items()}
    for name, time in {
        "time": clock,
        "time-jitters": clock + 0.03 / RATE * dice,
        "time-scatters": clock + 0.11 / RATE * np.clip(dice, -2, 2),
        "time-has-a-gap": clock + np.where(t > 0.83, 2.9 / RATE, 0.0) + np.where(t > 1.1, 5.0 / RATE, 0.0),
        "time-stops": np.where(np.arange(t.size) == 431, clock[430], clock),
        "time-runs-back": np.where(t > 0.9, clock - 0.41, clock),
        "time-is-coarse": quantised(clock, 0.001),
        "time-is-coarser": quantised(clock, 0.0001),
        "time-is-nan": np.where(np.arange(t.size) == 99, np.nan, clock),
    }.items():
        found[name] = ({"t": time, "u": u, "y": y}, timed)
    found["two-rates"] = ({"t": 0.37 + 1.017 * t, "u": u, "y": y}, one)
    found["no-rate"] = ({"u": u, "y": y}, timed)
    v = 2.2 + 1.1 * np.sin(2 * np.pi * 11.9 * t + 0.7)
    found["clipped-part"] = (found["clipped-high"][0], one | {"part_s": (0.617, 1.291)})
    both = {"inputs": ["u", "v"], "outputs": ["y", "z"], "rate_hz": RATE}
    y2, z2 = y + 0.02 * v, 0.3 - 0.04 * v + 0.003 * u + 1e-4 * noise(t.size, 20)
    found |= {
        "two": ({"u": u, "v": v, "y": y2, "z": z2}, both),
        "two-of-one": ({"u": u, "v": 0.7 - 0.31 * u, "y": y2, "z": z2}, both),
        "two-one-rests": ({"u": u, "v": 2.2 + 0 * v, "y": y, "z": z2}, both),
        "two-one-is-faint": ({"u": u, "v": 2.2 + 1e-3 * v, "y": y, "z": z2}, both),
        "two-one-rests-together": (
            {"u": u, "v": 2.2 + 1e-3 * v, "y": y, "z": noise(t.size, 21, 0.1)},
            both | {"alone": False},
        ),
        "two-one-is-dead": ({"u": u, "v": v, "y": y, "z": noise(t.size, 22, 0.1)}, both),
        "two-part": ({"u": u, "v": v, "y": y2 + 0.03 * t, "z": z2}, both | {"part_s": (0.213, 1.109)}),
        "two-period": ({"u": u, "v": v, "y": y2, "z": z2}, both | {"period_samples": 237}),
        "two-no-part": ({"u": u, "v": v, "y": y2, "z": z2}, both | {"part_s": (0.9, 1.7)}),
        "two-no-period": ({"u": u, "v": v, "y": y2, "z": z2}, both | {"period_samples": 4711}),
        "two-twice": ({"u": u, "v": v, "y": y2, "z": z2}, both | {"inputs": ["v", 1]}),
        "two-no-name": ({"u": u, "v": v, "y": y2, "z": z2}, both | {"outputs": ["y", "zed"]}),
        "two-same": ({"u": u, "v": v, "y": y2, "z": z2}, both | {"outputs": ["y", "v"]}),
    }
    return found


def checks(place: Place) -> list[str]:
    """What each check finds, refused and taken on."""
    said = {}
    for name, (columns, options) in doubtful().items():
        said[place.write(f"{name}.csv", table(columns, digits=9 if "t" in columns or name == "flicker" else 6))] = (
            options
        )
    place.write("recordings.json", json.dumps(said))
    found = library(place, "findings")
    for name, *options in (("clipped-high",), ("drift-refused", "--accept", "clipping"), ("dead", "--accept", "drift")):
        channels = ("--input", "u", "--output", "y", "--rate", "1730")
        found += place.told("identify", f"{name}.csv", *channels, "--static", *options)
    return found


# ------------------------------------------------------------------------------------------------------------- mirrors
MIRROR = """
name = "Generic"
travel = "1.7 mrad"
composition = "COMPOSITION"
rate_limit = "730 V/s"
bias = "4.2 V"
drive_min = "-1.3 V"
drive_max = "9.1 V"

[linear]
poles = ["310 Hz", "1.9 kHz", "87 Hz"]
pole_dampings = [0.07, 0.6, 1.0]
zeros = ["430 Hz", "140 Hz"]
zero_dampings = [0.09, -1.0]
normalise_at = "3.1 Hz"
excited_from = "1.3 Hz"
excited_to = "640 Hz"

[creep]
time_constants = ["0.07 s", "0.9 s"]
weights = ["1.3 urad/V", "-0.6 urad/V"]
"""
"""A mirror file of version 1, but for its hysteresis."""

COEFFICIENTS = """
numerator = [1.3, 41.0, 4.7e6]
denominator = [1.0, 930.0, 1.3e6, 5.1e8, 1.1e11]
normalise_at = "2.3 Hz"
excited_from = "1.7 Hz"
excited_to = "410 Hz"
"""
PLAYS = """
[prandtl_ishlinskii]
thresholds = ["0 V", "0.7 V", "2.9 V"]
weights = ["57 urad/V", "8.3 urad/V", "6.1 urad/V"]
widening = "31 us"
"""
BOUC_WEN = """
[bouc_wen]
d1 = "0.071 mrad/V"
d2 = "-2.3e-6 s/V"
epsilon = "-14 urad/V"
delta = "0.00031 s/V"
alpha = "1.9 1/V"
beta = "0.4 1/V"
gamma = "-0.13 1/V"
eta = "0.17 1/V"
exponent = 1.3
"""
KNOWN = """
[uncertainty]
parameters = ["bouc_wen.d1", "bouc_wen.epsilon", "bouc_wen.alpha", "linear.poles.1", "linear.zeros"]
standard_errors = [0.011, 0.07, 0.13, 0.004, 0.03]
correlation = [0.3, -0.2, 0.6, 0.1, 0.0, -0.4, 0.2, -0.1, 0.05, 0.3]
"""
SEVERAL = """
version = 2
name = "Three sensors on two actuators"

[actuators.1]
name = "tilt about x"
bias = "41 V"
drive_min = "-3 V"
drive_max = "97 V"
rate_limit = "17 kV/s"

[actuators.2]
name = "tilt about y"
bias = "53 V"
drive_min = "7 V"
drive_max = "103 V"
rate_limit = "23 kV/s"

[outputs.1]
name = "east"
quantity = "displacement"
position = ["31 mm", "2 mm"]

[outputs.2]
name = "north"
quantity = "displacement"
position = ["-13 mm", "27 mm"]

[outputs.3]
name = "south"
quantity = "displacement"
position = ["-17 mm", "-23 mm"]

[recording]
delay = "83 us"
rate = "1.9 kHz"
steps_per_sample = 3
excited_from = "1.3 Hz"
excited_to = "470 Hz"

[modes]
decay = ["19 1/s", "41 1/s", "730 1/s"]
frequency = ["890 rad/s", "-1210 rad/s", "0 rad/s"]

[matrices]
B = [[0.0, 3.0], [-890.0, -21.0], [1.7, 0.0], [27.0, -1190.0], [310.0, -170.0]]
C = [
  [0.1e-6, 0.2e-6, -3.1e-6, 0.0, 0.9e-6],
  [2.7e-6, 0.0, 1.3e-6, 0.3e-6, -0.4e-6],
  [-2.3e-6, 0.1e-6, 1.9e-6, 0.0, 0.2e-6],
]
D = [[1.3e-9, 0.0], [0.0, -2.1e-9], [0.7e-9, 0.4e-9]]
E = [[0.0, 0.0, 3.0], [-870.0, 0.0, 0.0], [0.0, 11.0, 0.0], [0.0, -930.0, 0.0], [0.0, 0.0, 270.0]]
F = [[1.0, 0.0, 0.02, 0.0, 0.0], [0.0, 0.03, 0.9, 0.0, 0.0]FREE]
GIVEN
K = [[0.0, 0.0, 1.7e-8], [0.0, 0.0, -0.9e-8], [0.0, 0.0, 0.6e-8]]

[hysteresis.1]
model = "plays"
thresholds = ["0.4 V", "1.9 V", "7 V"]
weights = [0.031, 0.023, 0.017]
polynomial = [0.03, -0.02, 0.05]
reach = "11 V"

[hysteresis.2]
model = "plays"
thresholds = ["0.7 V", "2.3 V"]
weights = [0.029, 0.013]

[hysteresis.3]
model = "bouc-wen"
d1 = 0.07
epsilon = -0.013
alpha = "0.4 1/V"
beta = "0.1 1/V"
gamma = "0.03 1/V"
eta = "-0.02 1/V"
exponent = 1.2

[uncertainty]
parameters = ["modes.decay.1", "modes.frequency.2", "matrices.B.4.1", "hysteresis.1.weights.2", "recording.delay"]
standard_errors = [0.7, 1.3, 1.9, 0.003, 3.0e-6]
correlation = [0.1, -0.2, 0.6, 0.0, 0.3, 0.1, 0.2, -0.1, 0.0, 0.4]
"""
"""A mirror file of version 2: hysteresis of the stiffness, and beside the modes one of the drives."""


def mirrors(place: Place) -> list[str]:
    """Models of hysteresis and mirrors by the public functions, mirror files of both versions among them."""
    by_roots, dynamics = MIRROR, MIRROR[MIRROR.index("[linear]") : MIRROR.index("[creep]")]
    by_coefficients = changed(by_roots, (dynamics, f"[linear]{COEFFICIENTS}\n"))
    free = {"FREE": ", [0.0, 0.0, 0.0, 0.0, 0.0]", "GIVEN": "G = [[0.0, 0.0], [0.0, 0.0], [0.6, -0.3]]"}
    several = changed(SEVERAL, *free.items())
    files = {
        "cascade": changed(by_roots, ("COMPOSITION", "cascade")) + BOUC_WEN + KNOWN,
        "additive": changed(by_coefficients, ("COMPOSITION", "additive")) + PLAYS,
        "static": changed(by_roots, ("COMPOSITION", "static"), (dynamics, "")) + BOUC_WEN,
        "compared": changed(by_roots, ("COMPOSITION", "cascade")) + PLAYS + BOUC_WEN.replace("[", "[comparison."),
        "several": several,
        "wrong": changed(by_roots, ("COMPOSITION", "static"), ('"9.1 V"', '"-2 V"')) + PLAYS + BOUC_WEN,
        "several-wrong": changed(several, ("[310.0, -170.0]", "[310.0]"), ("decay = [", 'decay = ["-1 1/s", ')),
    }
    for name, text in files.items():
        place.write(f"{name}-mirror.toml", text)
    return [*library(place, "hysteresis"), *library(place, "mirrors")]


# --------------------------------------------------------------------------------------------------- linear responses
def turned(drives: Floats, rate: float = RATE) -> dict[str, Floats]:
    """Two drives and what three sensors read of them, two modes of both, each with an offset of its own."""
    u, v = drives.T
    first = resonance(0.9 * (u - 4.2) - 0.2 * (v + 1.3), 137.0, 0.06, rate)
    second = resonance(0.3 * (u - 4.2) + 1.1 * (v + 1.3), 223.0, 0.11, rate)
    found = {"x": 61.0 * first - 3.0 * second, "y": -5.0 * first + 47.0 * second, "z": 23.0 * first + 31.0 * second}
    offset = {"x": 3.1, "y": -7.7, "z": 1.9}
    scatter = {"x": 0.11, "y": 0.07, "z": 0.19}
    read = {
        key: values + offset[key] + noise(u.size, 41 + i, scatter[key]) for i, (key, values) in enumerate(found.items())
    }
    return {"u": u, "v": v, **read}


def lines(realisation: int, periods: int = 3, length: int = 360, amplitude: float = 0.31) -> Floats:
    """Two drives of odd harmonics with random phases, orthogonal in each pair of realisations, whole periods (V)."""
    dice = np.random.Generator(np.random.PCG64(61 + realisation // 2))
    harmonics = np.arange(3, 0.3 * length, 2)
    phases = dice.uniform(0, 2 * np.pi, (2, harmonics.size))
    turn = np.array([0.0, np.pi * (realisation % 2)])
    angles = 2 * np.pi * np.outer(np.arange(length), harmonics) / length
    one = np.stack([np.sin(angles + phases[i] + turn[i]).sum(axis=1) for i in range(2)], axis=1)
    return np.tile(np.array([4.2, -1.3]) + amplitude * np.array([0.41, 0.29]) * one, (periods, 1))


def behind(columns: Mapping[str, Floats], first: int) -> dict[str, Floats]:
    """A recording without its first samples, which begins when the mirror has settled."""
    return {key: values[first:] for key, values in columns.items()}


def responses(place: Place) -> list[str]:
    """Frequency responses, measured and fitted, by the public functions."""
    for realisation in range(4):
        place.write(f"lines-{realisation}.csv", table(behind(turned(lines(realisation, 4)), 360)))
    t = times(2300)
    for i, (first, second) in enumerate(((0.53, 0.07), (-0.11, 0.47))):
        drives = np.stack([chirp(t, middle=4.2, amplitude=first), chirp(t, 2.3, 410.0, -1.3, second)], axis=1)
        place.write(f"chirp-{i}.csv", table(turned(drives)))
    return [*library(place, "frequency_responses"), *library(place, "measured")]


def fitted(place: Place) -> list[str]:
    """Each form of hysteresis fitted by the public function."""
    return library(place, "fitted")


# ------------------------------------------------------------------------------------------------------ identification
def identified(place: Place, *words: str, as_json: bool = False, several: bool = False, digits: int = 3) -> list[str]:
    """What `microrad identify` says and writes: its page and the mirror file.

    Args:
        place: The folder.
        words: Of the command.
        as_json: Whether its JSON document is asked for, which is kept number by number.
        several: Whether the mirror has several axes: what its file makes of a drive is kept in place of its states.
        digits: Of a number of the document, the figures and the mirror file: a search ends where it is flat.
    """
    command = ("identify", *words, "--mirror-file", "found.toml", "--overwrite")
    if as_json:
        said = [f"$ microrad {' '.join(command)} --json", *told.numbers(place.json(*command), digits)]
    else:
        said = place.told(*command)
    for path, lines in (
        (place.folder / "found.html", lambda page: told.page(page, digits, 1e-4)),
        (place.folder / "found.toml", lambda file: told.plain(file.read_text(encoding="utf-8"))),
    ):
        if path.exists():
            kept = told.shortened(lines(path), digits)
            kept = kept[: kept.index("[modes]")] if "[modes]" in kept else kept
            said += [f"== {path.name}", *map(_settled, kept)]
    if several:
        said += library(place, "found")
    for name in ("found.html", "found.toml"):
        (place.folder / name).unlink(missing_ok=True)
    return said


def _settled(line: str) -> str:
    """A line without what rounding decides.

    That is how many values of a row differ, the states of several axes, and the third digit of a correlation.
    """
    if line.startswith("plot of autocorrelation"):
        line = re.sub(r"-?\d+\.\d+(?:e-?\d+)?", lambda found: f"{float(found[0]):.2g}", line)
    return re.sub(r"(\[modes\]).*", r"\1", told.DISTINCT.sub("", line))


def static(place: Place) -> list[str]:
    """The hysteresis alone, from loops with units, signs, parts and faults of all kinds."""
    t = times(760)
    u = sines(t, 4.3, 2.9, 9.7)
    y = mirror(u, 3)
    place.write("loops.csv", table({"drive": u, "angle": y}))
    place.write("other.csv", table({"drive": sines(t, 4.9, 2.3, 13.7), "angle": mirror(sines(t, 4.9, 2.3, 13.7), 4)}))
    place.write("millivolts.csv", table({"drive [mV]": 1e3 * u, "angle [urad]": 71.0 - 1e3 * y}))
    place.write(
        "lever.csv", table({"t": t + 0.3, "drive": u + 0.05 * noise(t.size, 71), "tip": 37.0 * y + 1.9 * t}, digits=9)
    )
    one = 3.9 + 2.1 * np.sin(2 * np.pi * 17.3 * t)
    lags = lfilter([0.0, 0.004], [1.0, -0.996], one - 4.2)
    place.write("creeps.csv", table({"drive": one, "angle": mirror(one, 5) + 0.006 * lags}))
    for name, drive in (("wrong-way", u), ("other-way", sines(t, 4.1, 2.4, 12.1))):
        back = resonance(plays(drive - 4.2, {0.0: 0.031, 0.21: -0.043, 0.9: 0.051})) + noise(t.size, 72, 1e-4)
        place.write(f"{name}.csv", table({"drive": drive, "angle": back}))
    place.write("unrelated.csv", table({"drive": u, "angle": 0.3 * np.sin(2 * np.pi * 31.0 * t) + 0.01 * u}))
    place.write("far.csv", table({"drive": u, "angle": 9000.0 * y}))
    columns = ("--input", "0", "--output", "1", "--static")
    timed = (*columns, "--rate", "1730")
    found = identified(place, "loops.csv", *timed)
    both = ("loops.csv", "other.csv", *timed, "--hold-out", "0.37", "--name", "Two recordings")
    found += identified(place, *both, as_json=True)
    found += identified(place, "millivolts.csv", *timed, "--model", "prandtl-ishlinskii")
    lever = ("--input", "drive", "--output", "tip", "--static", "--output-unit", "um", "--lever-arm", "37 mm")
    found += identified(place, "lever.csv", *lever, "--measured-drive", "--accept", "jitter")
    found += identified(place, "creeps.csv", *timed, "--model", "bouc-wen-creep", "--period", "100")
    found += identified(place, "wrong-way.csv", *timed, "--validate", "other-way.csv", "--admissible", "--seed", "3")
    found += identified(place, "wrong-way.csv", *timed, "--hold-out", "0.21")
    for words in (
        ("unrelated.csv", *timed, "--accept", "dead"),
        ("far.csv", *timed),
        ("loops.csv", *timed, "--output-unit", "um"),
        ("loops.csv", *timed, "--lever-arm", "31 mm"),
        ("loops.csv", *timed, "--hold-out", "1.2"),
        ("loops.csv", *timed, "--position", "3 mm,-1 mm"),
        ("loops.csv", "loops.csv", *timed),
        ("millivolts.csv", *timed, "--output-unit", "mrad"),
        ("loops.csv", "millivolts.csv", *timed, "--name", "One of them states its units"),
        ("loops.csv", *columns, "--rate", "1730 V"),
        ("loops.csv", "--output", "1", "--static"),
        ("loops.csv", *timed, "--axes", "samples", "--time", "0"),
        ("loops.csv", *timed, "--output-file", "other.csv"),
        ("loops.csv", *timed, "--name", " "),
        ("none.csv", *timed),
        ("loops.csv", *timed, "--report", "found.toml"),
    ):
        found += identified(place, *words)
    return found


def whole(place: Place) -> list[str]:
    """All models, from loops with a chirp, and with multisines whose distortion and noise are told apart."""
    t = times(640)
    u = sines(t, 4.3, 2.9, 9.7)
    place.write("loops.csv", table({"u": u, "y": mirror(u, 3)}))
    v = sines(t[:420], 4.9, 2.3, 13.7)
    place.write("other.csv", table({"u": v, "y": mirror(v, 4)}))
    w = chirp(times(900), 3.1)
    place.write("chirp.csv", table({"u": w, "y": mirror(w, 5)}))
    for i in range(2):
        x = lines(i, 4, 240, 0.09)[:, 0]
        place.write(f"lines-{i}.csv", table(behind({"u": x, "y": mirror(x, 6 + i)}, 240)))
    columns = ("--input", "u", "--output", "y", "--rate", "1730 Hz")
    found = identified(
        place, "loops.csv", "chirp.csv", *columns, "--validate", "other.csv", "--name", "All models", digits=2
    )
    periodic = (*columns, "--period", "240", "--model", "prandtl-ishlinskii-rate", "--name", "Lines")
    return found + identified(place, "loops.csv", "lines-0.csv", "lines-1.csv", *periodic, as_json=True, digits=2)


SEARCHED = re.compile(
    r"(candidates\.hysteretic|within_noise\.[1-9]|worst|verdict|band_error|delay_s|responses\.\d+\.modelled).*"
)
"""What the search for hysteretic stiffness leaves: it is ended before its optimum, elsewhere on each processor.

Among it which candidates are as good as the chosen one, as that hangs on what is left of them.
"""


def sprung(drives: Floats) -> dict[str, Floats]:
    """Two drives and what three sensors read of two modes whose springs lose some stiffness to hysteresis."""
    steps, forces = 10, (drives - np.array([4.2, -1.3])) @ np.array([[0.9, 0.3], [-0.2, 1.1]])
    w, damping = 2 * np.pi * np.array([137.0, 223.0]), np.array([0.05, 0.07])
    thresholds, weights = np.array([[0.04, 0.17], [0.06, 0.21]]), np.array([[0.11, 0.08], [0.07, 0.1]])
    place, speed, state, found = np.zeros(2), np.zeros(2), np.zeros((2, 2)), np.empty(forces.shape)
    for i, force in enumerate(forces):
        found[i] = place
        for _ in range(steps):
            state = np.clip(state, place[:, None] - thresholds, place[:, None] + thresholds)
            pull = force - place + (weights * state).sum(axis=1)
            speed = speed + (w**2 * pull - 2 * damping * w * speed) / (RATE * steps)
            place = place + speed / (RATE * steps)
    offset, scatter = np.array([3.1, -7.7, 1.9]), np.array([0.02, 0.013, 0.031])
    read = found @ np.array([[61.0, -5.0, 23.0], [-3.0, 47.0, 31.0]]) + offset
    dice = noise(read.size, int(1e3 * np.ptp(drives)) % 997).reshape(read.shape) * scatter
    return dict(zip("uvxyz", np.hstack([drives, read + dice]).T, strict=True))


def axes(place: Place) -> list[str]:
    """Mirrors of two drives and three sensors: linear, and with hysteresis of the stiffness."""
    for i in range(4):
        place.write(f"line-{i}.csv", table(behind(turned(lines(i, 4, 120)), 120)))
        for size, amplitude in (("small", 0.13), ("large", 0.6)):
            place.write(f"{size}-{i}.csv", table(behind(sprung(lines(i, 4, 90, amplitude)), 90), digits=7))
    channels = ("--input", "u", "--input", "v", "--output", "x", "--output", "y", "--output", "z", "--rate", "1730")
    places = [word for at in ("11 mm,2 mm", "-7 mm,13 mm", "-5 mm,-9 mm") for word in ("--position", at)]
    straight = [f"line-{i}.csv" for i in range(4)]
    found = identified(
        place, *straight, *channels, *places, "--output-unit", "um", "--period", "120", "--name", "Line", several=True
    )
    bent = [f"{size}-{i}.csv" for size in ("small", "large") for i in range(3)]
    judged = ("--validate", "small-3.csv", "--validate", "large-3.csv", "--name", "Sprung")
    words = (*bent, *judged, *channels, "--output-unit", "urad", "--period", "90")
    sprung_ones = told.numbers(place.json("identify", *words, "--mirror-file", "found.toml"), 3)
    for size, amplitude in (("small", 0.13), ("large", 0.6)):
        for i in (0, 2, 4):
            columns = sprung(lines(i, 4, 90, amplitude) * [1.0, 0.0] + [0.0, -1.3])
            place.write(f"spring-{size}-{i}.csv", table(behind({key: columns[key] for key in "ux"}, 90), digits=7))
    return [*found, *(line for line in sprung_ones if not SEARCHED.match(line)), *library(place, "stiffness")]


# -------------------------------------------------------------------------------------------------------------- bench
PLAN = """
name = "Generic plan"
formats = [FORMATS]

[limits]
rate = "7 kHz"
drive_min = "-1.3 V"
drive_max = "9.7 V"
slew = "13 V/ms"
samples_per_period = 7

[bench]
truth = "bench"
axes = AXES
crosstalk = -0.07

[bench.amplifier]
gain = 11
output_min = "-17 V"
output_max = "113 V"
bandwidth = "1.9 kHz"
slew = "0.7 V/us"

[bench.converters]
bits = 12
drive_min = "-2.3 V"
drive_max = "10.1 V"
output_min = "-0.7 mrad"
output_max = "1.9 mrad"

[bench.sensor]
noise = "1.7 urad"
mains = "2.3 urad"
mains_frequency = "60 Hz"
drift = "700 nrad/s"

[excitation.sweep]
kind = "chirp"
start = "3.1 Hz"
stop = "870 Hz"
duration = "0.23 s"
amplitude = "0.43 V"
offset = "4.7 V"

[excitation.growing]
kind = "sines"
frequencies = ["35 Hz", "70 Hz"]
amplitudes = ["0.9 V", "2.3 V", "3.1 V"]
periods = 2
offset = "4.3 V"
noise_share = 0.03

[excitation.steps]
kind = "staircase"
levels = ["4.1 V", "7.3 V", "-0.7 V", "2.9 V"]
dwell = "31 ms"
rise = "2.3 ms"
rate = "4.1 kHz"

[excitation.lines]
kind = "multisine"
use = "validation"
lines = "odd-random"
start = "14 Hz"
stop = "700 Hz"
period = "0.1 s"
rms = "0.31 V"
offset = "4.9 V"
periods = 2
realisations = 2
seed = 17
"""
PRINTED = """
[excitation.linear]
kind = "chirp"
truth = "linear"
start = "7 Hz"
stop = "430 Hz"
duration = "0.11 s"
amplitude = "1.3 V"
offset = "3.7 V"

[excitation.printed]
kind = "sines"
truth = "bouc-wen"
frequencies = ["56 Hz"]
amplitudes = ["2.7 V"]
periods = 3
offset = "4.4 V"
"""


def bench(place: Place) -> list[str]:
    """Plans of all excitations, played into each mirror and format, and plans that are refused."""
    one = changed(PLAN, ("FORMATS", '"csv"'), ("AXES", "1"))
    two = changed(PLAN, ("FORMATS", '"csv", "lvm", "tdms", "mat", "mat73", "npz", "hdf5"'), ("AXES", "2"))
    two = changed(two, ('offset = "4.7 V"', 'offset = "4.7 V"\naxis = 2'))
    place.write("one.toml", one.replace('lines = "odd-random"', 'lines = "all"') + PRINTED)
    place.write("two.toml", two)
    found: list[str] = []
    for name, words in (("one", ("--seed", "7")), ("two", ())):
        found += place.told("bench", f"{name}.toml", "--output", name, *words)
        manifest = json.loads((place.folder / name / "manifest.json").read_text(encoding="utf-8"))
        found += told.numbers(manifest["records"])
    one_axis = {"inputs": "drive", "outputs": "angle", "accept": ACCEPTABLE}
    two_axes = {"inputs": ["drive1", "drive2"], "outputs": ["angle1", "angle2"], "accept": ACCEPTABLE, "alone": False}
    records = {f"one/{path.name}": one_axis for path in sorted((place.folder / "one").glob("*.csv"))}
    for path in sorted((place.folder / "two").iterdir()):
        if path.suffix == ".csv" or path.stem.startswith("steps"):
            records[f"two/{path.name}"] = two_axes
    place.write("recordings.json", json.dumps(records))
    found += library(place, "read")
    for changes in (
        (('"9.7 V"', '"12 V"'),),
        (('stop = "870 Hz"', 'stop = "1.9 kHz"'), ('amplitude = "0.43 V"', 'amplitude = "7 V"')),
        (("periods = 2\noffset", "periods = 3\noffset"), ('"35 Hz", "70 Hz"', '"33 Hz", "71 Hz"')),
        (('rise = "2.3 ms"', 'rise = "0.3 ms"'), ('"7.3 V"', '"11.3 V"')),
        (('period = "0.1 s"', 'period = "0.10003 s"'), ('lines = "odd-random"', 'lines = "some"')),
        (('kind = "chirp"', 'kind = "chrip"'), ("bits = 12", "bits = 3"), ('noise = "1.7 urad"', "noise_share = 11")),
        (('start = "3.1 Hz"', 'start = "900 Hz"'), ('dwell = "31 ms"', 'dwell = "0.1 ms"')),
        (('output_max = "1.9 mrad"', 'output_max = "0.3 mrad"'),),
    ):
        place.write("wrong.toml", changed(one, *changes))
        found += place.told("bench", "wrong.toml", "--output", "wrong")
    found += place.told("bench", "one.toml", "--output", "one")
    return found


# ------------------------------------------------------------------------------------------------------------- formats
def formats(place: Place) -> list[str]:
    """Files of each format, with units, times, comments and names of many kinds; lists and arrays."""
    t = times(331)
    u, y = sines(t), mirror(sines(t), 91)
    rows = [f"{time:.9f};{a:.5f};{b:.6f}".replace(".", ",") for time, a, b in zip(t + 0.1, u, y, strict=True)]
    spaced = [f"{a:.5f} {b:.6f}" for a, b in zip(1e3 * u, 1e3 * y, strict=True)]
    pairs = [f"{1e3 * time:.6f}\t{a:.5f}\t{b:.6f}" for time, a, b in zip(t, u, y, strict=True)]
    texts = {
        "semicolons.csv": "# a comment\nZeit;Spannung;Winkel\ns;V;mrad\n" + "\n".join(rows) + "\n",
        "points.csv": "Zeit;Spannung;Winkel\ns;V;mrad\n" + "\n".join(rows).replace(",", ".") + "\n",
        "spaces.dat": "% drive and angle\n" + "\n".join(spaced) + "\n",
        "tabs.tsv": "Time (ms)\tdrive [V]\tangle (mrad)\n" + "\n".join(pairs) + "\n",
        "words.csv": "drive,angle\n" + "\n".join(row.replace(" ", ",") for row in spaced[:250]) + "\n3.1,off\n",
        "ragged.csv": "drive,angle\n" + "\n".join(row.replace(" ", ",") for row in spaced[:250]) + "\n3.1\n",
    }
    for name, text in texts.items():
        place.write(name, text)
    whole_array = np.round(np.stack([u, 0.7 * u[::-1]], axis=1), 6), np.round(np.stack([y, -y], axis=1), 6)
    np.save(place.folder / "bare.npy", np.column_stack([*whole_array]))
    np.savez(place.folder / "named.npz", drive=whole_array[0][:, 0], both=whole_array[1], fs=np.array(RATE))
    savemat(place.folder / "structure.mat", {"s": {"u": whole_array[0], "y": whole_array[1], "dt": 1 / RATE}})
    with h5py.File(place.folder / "groups.h5", "w") as file:
        group = file.create_group("bench")
        group.attrs["rate_hz"] = RATE
        for key, unit, values in (("u", "mV", 1e3 * whole_array[0][:, 0]), ("y", "urad", 1e3 * whole_array[1][:, 1])):
            group.create_dataset(key, data=values).attrs["units"] = unit
        file.create_dataset("other/u", data=whole_array[0][:, 1])
    rate = {"rate_hz": RATE}
    wanted: list[tuple[str, dict[str, Any]]] = [
        ("semicolons.csv", {"inputs": "Spannung", "outputs": "Winkel"}),
        ("points.csv", {"inputs": "Spannung", "outputs": "Winkel"}),
        ("spaces.dat", {"inputs": 0, "outputs": 1, **rate}),
        ("tabs.tsv", {"inputs": 1, "outputs": 2, "part_s": (0.03, 0.17), "period_samples": 97}),
        ("words.csv", {"inputs": 0, "outputs": 1, **rate}),
        ("ragged.csv", {"inputs": 0, "outputs": 1, **rate}),
        ("bare.npy", {"inputs": ["data[0]", "data[1]"], "outputs": ["data[3]", "data[2]"], **rate, "alone": False}),
        ("named.npz", {"inputs": "drive", "outputs": "both[1]"}),
        ("structure.mat", {"inputs": "s/u[1]", "outputs": "s/y[0]", "accept": ["lead"]}),
        ("groups.h5", {"inputs": "bench/u", "outputs": "y"}),
        ("groups.h5", {"inputs": "u", "outputs": "y"}),
        ("bare.npy", {"inputs": "data[0]", "outputs": "data[4]", **rate}),
        ("structure.mat", {"inputs": "s/v", "outputs": "s/y[0]"}),
    ]
    place.write("recordings.json", json.dumps(wanted))
    found = library(place, "read")
    shape = np.stack([np.stack([lines(i, 3, 240).reshape(3, 240, 2)], axis=0)[0] for i in range(2)], axis=0)
    read = np.stack(
        [np.stack([turned(d.reshape(-1, 2))[key] for key in "xyz"], axis=1).reshape(3, 240, 3) for d in shape]
    )
    np.save(place.folder / "drives.npy", np.round(shape.transpose(1, 0, 3, 2), 6))  # periods, realisations, channels
    np.save(place.folder / "outputs.npy", np.round(read.transpose(1, 0, 3, 2), 5))
    np.savez(place.folder / "swapped.npz", u=shape.transpose(1, 0, 3, 2), y=read.transpose(0, 1, 3, 2))
    found += library(place, "arrays")
    t = times(760)
    loops = sines(t, 4.3, 2.9, 9.7)
    place.write("loops.csv", table({"drive": loops, "angle": 1e3 * mirror(loops, 3)}))
    listed = """
name = "From a list"
input = "drive"
output = 1
rate = "1730 Hz"
output_unit = "urad"

[recording.early]
file = "loops.csv"
to = "0.31 s"
role = "loops"

[recording.late]
file = "loops.csv"
from = "0.31 s"
role = "validation"
"""
    place.write("list.toml", listed)
    found += identified(place, "list.toml", "--static")
    for changes in (
        (('from = "0.31 s"', 'from = "0.21 s"'),),
        (('role = "loops"', 'role = "loop"'), ("output = 1", 'output_units = "V"'), ('to = "0.31 s"', 'to = "0 s"')),
        (('role = "loops"', 'role = "validation"'),),
        (('output_unit = "urad"', 'output_unit = "urad"\nsigns = [[1, -1]]'),),
        (('output_unit = "urad"', 'output_unit = "urad"\naccept = ["noise"]\naxes = ["channels"]'),),
        (('from = "0.31 s"', 'from = "0.43 s"\nto = "0.47 s"'),),
    ):
        place.write("list.toml", changed(listed, *changes))
        found += place.told("identify", "list.toml", "--static")
    return found + place.told("identify", "list.toml", "--rate", "100")


# -------------------------------------------------------------------------------------------------------------- import
GIVEN = ("--travel", "1.7 mrad", "--drive", "-1.3 V", "9.1 V", "--bias", "4.2 V", "--rate-limit", "730 V/s")
BAND = ("--band", "1.3 Hz", "640 Hz", "--normalise-at", "3.1 Hz", "--output-unit", "mrad")


def imported(place: Place) -> list[str]:
    """Linear models of other tools in each form, and what no mirror can be; keys explained."""
    w = 2 * np.pi * np.array([310.0, 87.0])
    system = signal.TransferFunction([0.071 * w[0] ** 2 * w[1]], np.polymul([1.0, 0.14 * w[0], w[0] ** 2], [1.0, w[1]]))
    space, roots = system.to_ss(), system.to_zpk()
    held = signal.cont2discrete((system.num, system.den), 1 / 7300.0)
    forms: dict[str, dict[str, Any]] = {
        "coefficients": {"num": system.num, "den": system.den},
        "space": {"s": {"A": space.A, "B": space.B, "C": space.C, "D": space.D, "Ts": 0.0}},
        "roots": {"z": [], "p": roots.poles, "k": roots.gain},
        "sampled": {"num": held[0], "den": held[1], "Ts": held[2]},
        "falling": {"num": -system.num, "den": system.den},
        "unstable": {"num": system.num, "den": system.den * [1, -1, 1, 1]},
        "improper": {"num": np.polymul(system.num, [1.0, 2.0, 3.0, 4.0]), "den": system.den},
        "two": {"a": {"num": system.num, "den": system.den}, "b": {"num": 2.0 * system.num, "den": system.den}},
        "nothing": {"x": system.num},
    }
    found: list[str] = []
    for name, values in forms.items():
        savemat(place.folder / f"{name}.mat", values)
        found += place.told("import", f"{name}.mat", *GIVEN, *BAND)
    found += place.told("import", "two.mat", *GIVEN, *BAND, "--variable", "b", "--name", "The second")
    found += place.told("import", "roots.mat", *GIVEN, *BAND)
    wrong = ("--bias", "14.2 V"), ("--band", "700 Hz", "640 Hz"), ("--normalise-at", "1 Hz"), ("--travel", "3 V")
    for words in wrong:
        found += place.told("import", "roots.mat", *GIVEN, *BAND, *words, "--output", "other.toml")
    for path in sorted(place.folder.glob("*-mirror.toml")):
        found += [f"== {path.name}", *told.shortened(told.plain(path.read_text(encoding="utf-8")), 6)]
    for key in ("modulus_margin", "mirror.bouc_wen.eta", "thresholds", "hysteresis", "nonsense"):
        found += place.told("explain", key)
    schema = json.loads(place.run("schema"))
    return [*found, *told.numbers({key: schema["$defs"][key] for key in sorted(schema["$defs"]) if "Mirror" in key})]


def library(place: Place, word: str) -> list[str]:
    """What public functions return on the files of the case, as lines."""
    return told.plain(f"== {word}\n{place.python(LIBRARY, word)}")


CASES: Mapping[str, Case] = {
    "lab-checks": Case(checks),
    "lab-mirrors": Case(mirrors),
    "lab-responses": Case(responses),
    "lab-fitted": Case(fitted),
    "lab-static": Case(static, quick=False),
    "lab-whole": Case(whole, quick=False),
    "lab-axes": Case(axes, quick=False),
    "lab-bench": Case(bench),
    "lab-formats": Case(formats),
    "lab-import": Case(imported, quick=False),
}
"""All of them; a file reference/told/NAME.txt each."""
