"""Missions unlike each other, with choices that the shipped one has not made and numbers of their own.

What the commands say of them is kept word for word (`told`).
"""

import random
import re
from collections.abc import Callable, Mapping

from reference import told
from reference.cases import GALLERY, ROOT, Case, Place, without

FIXED = re.compile(
    r".*(seed|runs|attempts|windows|number|_frames|satellites|planes|phasing|terminals|order|epoch|sigmas|settle|duration"
    r"|local_time|latitude|longitude|phase|confidence|quantile|probability|outage|coverage|corrected|_on_mirror|window"
    r"|numerator|denominator|normalise_at|excited_from|excited_to|rate_limit|bias|drive_min|drive_max|boresight"
    r"|magnification|coupling|rate_feedforward|strehl|output_min|output_max|gain|fine_pointing\.rate|control\.\w*"
    r"|fine_pointing\.delay|plant_step|optical_sensor\.rate|optical_sensor\.delay|hold|edges|exponent|alpha|beta|epsilon"
    r"|relay_share|m_squared|transverse_velocity|point_ahead|loop_amplitude|ionisation_ratio|code_rate|efficiency|bit_error_ratio|spacing|observation|limit|eccentricity|duration)"
)
"""Keys whose numbers stay: whole numbers, times that have to be multiples of each other, bounds."""

_NUMBER = re.compile(r'(?<=")-?\d+(?:\.\d+)?(?:e-?\d+)?(?= [^"]+")|^-?\d+\.\d+(?=\s*$)')
"""With its unit, or bare."""


def generic(text: str, seed: int) -> str:
    """A mission with each of its numbers changed by up to an eighth, but for `FIXED` ones.

    Args:
        text: TOML, a key a line.
        seed: Of the changes; each key has its own.
    """
    table, lines = "", []
    for line in text.splitlines():
        if heading := re.match(r"\[(.+)\]", line):
            table = heading[1]
        found = re.match(r"(\w+) = ([^#]*)(.*)", line)
        if found and not FIXED.fullmatch(f"{table}.{found[1]}"):
            dice = random.Random(f"{seed} {table}.{found[1]}")
            value = _NUMBER.sub(
                lambda number, dice=dice: f"{float(number[0]) * dice.uniform(0.875, 1.125):.4g}", found[2]
            )
            line = f"{found[1]} = {value}{found[3]}"  # noqa: PLW2901
        lines.append(line)
    return "\n".join(lines) + "\n"


def edited(text: str, changes: Mapping[str, str | None], more: str = "") -> str:
    """A mission with keys set (what stands behind the equals sign) or left out (None), and tables behind it.

    Args:
        text: TOML, a key a line.
        changes: By `table.key`; a table that the text has not is put behind it.
        more: Tables behind it.
    """
    waiting, table, lines = dict(changes), "", []
    for line in text.splitlines():
        if heading := re.match(r"\[(.+)\]", line):
            table = heading[1]
        if (found := re.match(r"(\w+) = ", line)) and (name := f"{table}.{found[1]}".lstrip(".")) in waiting:
            if (value := waiting.pop(name)) is not None:
                lines.append(f"{found[1]} = {value}")
            continue
        lines.append(line)
    text = "\n".join(lines) + "\n"
    for name, value in waiting.items():
        table, _, key = name.rpartition(".")
        if value is None:
            raise ValueError(f"{name} is not there")
        head = rf"(?m)^\[{re.escape(table)}\]\n"
        if not re.search(head, text):
            text += f"\n[{table}]\n"
        text = re.sub(head, lambda found, line=f"{key} = {value}\n": found[0] + line, text)
    return text + more


# --------------------------------------------------------------------------------------------------------------- texts
SHIPPED = (ROOT / "missions" / "leo-geo.toml").read_text(encoding="utf-8")
PAPER = (ROOT / "missions" / "paper.toml").read_text(encoding="utf-8")
CROSSLINK = (GALLERY / "crosslink.toml").read_text(encoding="utf-8")
TWO_AXES = re.findall(
    r"```toml\n(version = 2.*?)```", (ROOT / "docs" / "mirror-file.md").read_text(encoding="utf-8"), flags=re.DOTALL
)[0]

SHORT = {
    "fine_pointing.runs": "8",
    "fine_pointing.duration": '"0.4 s"',
    "fine_pointing.settle": '"0.1 s"',
    "acquisition.runs": "300",
    "operations.runs": "5",
    "operations.contact.windows": "3",
    "operations.contact.window": '"0.2 s"',
    "scenario.loop_frequencies": '["1 Hz", "100 Hz"]',
    "scenario.pid_frequencies": '["2 Hz", "15 Hz"]',
    "scenario.inverse_frequencies": '["15 Hz"]',
}
"""Runs that take a second."""

CODED = {"bit_error_ratio": "3e-6", "code_gain": '"5.2 dB"', "code_rate": "0.82", "bandwidth": '"3.7 GHz"'}
COUNTER = {
    "detector": '"photon-counting"',
    "efficiency": "0.43",
    "dark_count_rate": '"2300 1/s"',
    "background_power": '"1.3 pW"',
}
DIODE = {
    "modulation": '"ook"',
    "efficiency": "0.77",
    "dark_current": '"1.4 nA"',
    "thermal_noise": '"2.2 pA/sqrt(Hz)"',
    "background_power": '"12 pW"',
    "extinction_ratio": '"17 dB"',
}
AMPLIFIED = {"detector": '"preamplified"', "noise_figure": '"4.4 dB"'}
RECEIVERS = {
    "homodyne": {"modulation": '"bpsk"', "detector": '"homodyne"', "efficiency": "0.68"},
    "preamplified-dpsk": {"modulation": '"dpsk"', **AMPLIFIED},
    "preamplified-ook": {
        "modulation": '"ook"',
        **AMPLIFIED,
        "optical_bandwidth": '"23 GHz"',
        "amplifier_gain": '"33 dB"',
        "extinction_ratio": '"21 dB"',
    },
    "counting-ppm": {"modulation": '"ppm"', **COUNTER, "order": "16"},
    "counting-ook": {"modulation": '"ook"', **COUNTER, "extinction_ratio": '"19 dB"'},
    "pin": {"detector": '"pin"', **DIODE},
    "apd": {"detector": '"apd"', **DIODE, "avalanche_gain": "21.0", "ionisation_ratio": "0.23"},
    "heterodyne-qpsk": {
        "modulation": '"qpsk"',
        "detector": '"heterodyne"',
        "efficiency": "0.71",
        "polarisations": "2",
        "phase_error": '"73 mrad"',
        "inter_symbol_loss": '"0.37 dB"',
    },
}
SKY = """
[communication.receiver.background]
spectral_radiance = "11 W/(m^2 sr um)"
field_of_view = "93 urad"
filter_bandwidth = "1.2 nm"
"""
"""A receiver's own background in place of a power."""

BEAMS = {
    "pattern": {"conventions.pointing_loss": '"pattern"', "communication.beam.profile": '"gaussian"'}
    | {"communication.beam.radius": '"1.9 cm"', "communication.beam.m_squared": "1.15"},
    "uniform": {"conventions.pointing_loss": '"pattern"', "communication.beam.profile": '"uniform"'},
    "gain": {"conventions.pointing_loss": '"gain"'},
}
SPECTRA = {
    "first-order": {"spectrum": '"first-order"', "level": '"150 urad^2/Hz"', "corner": '"1.3 Hz"'},
    "table": {"spectrum": '"table"', "file": '"spectrum.csv"'},
}
SPECTRUM = "Hz, urad^2/Hz\n0, 140\n0.7, 100\n2, 30\n9, 1.9\n60, 0.04\n70, 0.3\n75, 0.03\n400, 0.001\n"

BUDGET = """
[error_budget]
with_loop = WITH_LOOP

[error_budget.sources.alignment]
class = "random"
size = "2.2 urad"            # assumption: calibrated on the ground
statistic = "3-sigma"
axes = "together"
gains = [1.0, -0.5]

[error_budget.sources.thermo_elastic]
class = "periodic"
size = "1.4 urad"            # literature: a model of the bench
statistic = "fixed"
axes = "each"
gains = [0.3, 1.0]
frequency = "0.2 mHz"

[error_budget.sources.tracker]
class = "constant"
size = "1.1 urad"
statistic = "bound"
axes = "each"
gains = [1.0, 1.0]

[error_budget.sources.wheels]
class = "process"
size = "0.9 urad"
statistic = "1-sigma"
axes = "each"
gains = [1.0, 0.7]
corner = "38 Hz"

[error_budget.sources.ageing]
class = "drift"
rate = "0.1 nrad/s"
statistic = "1-sigma"
axes = "each"
gains = [1.0, 1.0]
period = "6 h"

[error_budget.sources.unloading]
class = "transient"
size = "3.1 urad"
statistic = "fixed"
axes = "together"
gains = [0.5, -1.0]
period = "95 min"
decay = "20 s"

[error_budget.sources.mount]
class = "random"
size = "1.3 urad"
statistic = "2-sigma"
axes = "together"
gains = [0.8, 0.6]

[error_budget.correlations.bench]
first = "alignment"
second = "mount"
coefficient = 0.4

[error_budget.requirements.code_word]
index = "RPE"
window = "12 ms"
confidence = 0.9973
interpretation = "temporal"
axes = "radial"
limit = "4 urad"

[error_budget.requirements.offset]
index = "MPE"
window = "20 s"
confidence = 0.95
interpretation = "ensemble"
axes = "x"
limit = "3 urad"

[error_budget.requirements.beacon_cone]
index = "PDE"
window = "10 s"
spacing = "40 s"
observation = "90 min"
confidence = 0.99
interpretation = "mixed"
axes = "y"
limit = "2 urad"

[error_budget.requirements.all]
index = "APE"
confidence = 0.95
interpretation = "mixed"
axes = "radial"
limit = "9 urad"
"""


COUPLINGS = {
    "fibre": """
[communication.coupling]
into = "single-mode fibre"
mode_radius = "4.7 um"
focal_length = "39 cm"
lateral_error = "0.8 um"
angular_error = "3 mrad"
defocus = "51 nm"
coma = "-37 nm"
pointing_error = "1.7 urad"
""",
    "fibre-at-random": """
[communication.coupling]
into = "single-mode fibre"
mode_radius = "best"
astigmatism = "62 nm"
spherical = "23 nm"

[communication.coupling.jitter]
bias = ["0.3 urad", "-0.9 urad"]
rms = ["1.1 urad", "0.7 urad"]
bandwidth = "44 Hz"
""",
    "multi-mode": """
[communication.coupling]
into = "multi-mode fibre"
core_radius = "9 um"
numerical_aperture = 0.11
focal_length = "52 cm"
pointing_error = "6 urad"
""",
    "detector-of-a-twin": """
[communication.coupling]
into = "detector"
detector_radius = "11 um"
focal_length = "1.3 m"
coma = "48 nm"
twin = true
""",
}
"""What takes the light at the receiver: each end, pointed by each kind of error."""


def receiver(name: str) -> dict[str, str | None]:
    """Changes that put a receiver in place of a sensitivity."""
    table = {f"communication.receiver.{key}": value for key, value in (CODED | RECEIVERS[name]).items()}
    return {"communication.receiver_sensitivity": None, **table}


def vibration(name: str) -> dict[str, str | None]:
    """Changes that put a spectrum in place of that of OLYMPUS."""
    return {f"fine_pointing.vibration.{key}": value for key, value in SPECTRA[name].items()}


# --------------------------------------------------------------------------------------------------------------- links
def links(place: Place) -> list[str]:
    """Budgets of links with each receiver and each convention, at numbers of their own; a rate that is solved for."""
    bare = without(SHIPPED, *("acquisition", "orbit", "operations", "constellation", "fine_pointing", "mirror"))
    bare = without(bare, "amplifier", "control", "scenario")
    bare = edited(bare, {f"conventions.{key}": None for key in ("residual", "mirror_angle")})
    bare = edited(bare, {"requirement.residual_statistic": None})
    found: list[str] = []
    for seed, name in enumerate(RECEIVERS):
        changes = {**receiver(name), **[{}, *BEAMS.values()][seed % 4]}
        if seed % 2:
            changes |= {"conventions.strehl": '"ratio"', "conventions.divergence": '"half-1/e2"'}
            changes |= {"terminals.leo_obscuration": "0.21", "terminals.geo_obscuration": "0.18"}
            changes |= {"communication.wavefront_error": '"88 nm"', "communication.strehl": None}
            changes |= {"channel.zenith_transmission": "0.83", "channel.elevation": '"37 deg"'}
        if seed % 3 == 1:
            changes |= {"jitter.bias": '["3 urad", "-1.2 urad"]', "jitter.rms": '["4.1 urad", "2.6 urad"]'}
            changes |= {"jitter.bandwidth": '"27 Hz"', "terminals.leo_name": '"Ferry"', "terminals.geo_name": '"Relay"'}
        if seed % 3 == 2:
            changes |= {"point_ahead.corrected": "false", "communication.data_rate": '"largest"'}
        more = ""
        if name == "counting-ppm":
            del changes["communication.receiver.background_power"]
            more = SKY
        if "jitter.bias" in changes:
            changes |= {"communication.code_word": '"0.2 ms"'}
        file = place.write(f"{name}.toml", edited(generic(bare, seed), changes, more))
        found += place.told("budget", file, "--verbose") if seed % 2 else place.told("budget", file)
    for seed, (name, table) in enumerate(COUPLINGS.items()):
        changes = {"terminals.geo_obscuration": "0.27"}
        if seed % 2:
            changes |= {"jitter.bias": '["2.1 urad", "-0.6 urad"]', "jitter.rms": '["2.2 urad", "1.3 urad"]'}
            changes |= {"jitter.bandwidth": '"31 Hz"'}
        file = place.write(f"{name}.toml", edited(generic(bare, seed), changes) + table)
        found += place.told("budget", file, "--verbose")
    return found


def crosslink(place: Place) -> list[str]:
    """A link without a loop, at numbers of its own, and its day."""
    file = place.write("crosslink.toml", generic(CROSSLINK, 9))
    return [
        line for words in (("budget", "--verbose"), ("contacts",)) for line in place.told(words[0], file, *words[1:])
    ]


NONSENSE = '"5 parsec"', "-1e9", "true", '"0 m"', "[]", '["a", "b"]'
"""Values that most keys cannot have."""


def refused(place: Place) -> list[str]:
    """A mission in which every value is one of `NONSENSE`: each key says what it expects."""
    found: list[str] = []
    for value in NONSENSE:
        lines = [re.sub(r"^(\w+) = .*", rf"\1 = {value}", line) for line in SHIPPED.splitlines()]
        found += place.told("budget", place.write("mission.toml", "\n".join(lines) + BUDGET))
    return found


# ------------------------------------------------------------------------------------------------------------ missions
def whole(
    text: str,
    seed: int,
    changes: Mapping[str, str | None],
    *commands: tuple[str, ...],
    more: str = "",
    beside: Mapping[str, str] | None = None,
) -> Callable[[Place], list[str]]:
    """A study of a mission with its numbers changed, and what other commands say of it.

    Args:
        text: TOML.
        seed: Of the numbers.
        changes: Keys set or left out.
        commands: Words of each, in which FILE is the mission.
        more: Tables behind the mission's.
        beside: Texts of files that the mission names.
    """

    def measure(place: Place) -> list[str]:
        for name, content in (beside or {}).items():
            place.write(name, content)
        file = place.write("mission.toml", edited(generic(text, seed), changes, more))
        found = place.told("run", file, "--verbose", "--output", "study")
        if (place.folder / "study").exists():
            found += told.study(place.folder / "study")
        for words in commands:
            found += place.told(*(file if word == "FILE" else word for word in words))
        return told.settled(found)

    return measure


POINTING = (("pointing", "FILE"),)
DAY = ("contacts", "FILE"), ("constellation", "FILE")

CALM = {"epsilon": '"-0.024 mrad/V"', "alpha": '"2.7 1/V"', "beta": '"0.7 1/V"'}
"""Hysteresis that never moves the wrong way: what the paper's set does behind a reversal makes much of a rounding."""

ADDITIVE = {
    **SHORT,
    "mirror.composition": '"additive"',
    **{f"mirror.bouc_wen.{key}": value for key, value in CALM.items()},
    "mirror.comparison.bouc_wen.alpha": '"3.1 1/V"',
    "mirror.comparison.bouc_wen.beta": '"1.2 1/V"',
    "conventions.residual": '"radial"',
    "conventions.mirror_angle": '"optical"',
    "requirement.residual_statistic": '"rms"',
    "pointing.lines.misalignment.class": '"transient"',
    "pointing.lines.orbit_knowledge.axes": '"radial"',
    "pointing.lines.body_pointing.statistic": '"2-sigma"',
    "fine_pointing.geometry.incidence": '"17 deg"',
    "fine_pointing.geometry.rotation": '"23 deg"',
    "fine_pointing.geometry.magnification": "1.1",
    "fine_pointing.geometry.coupling": "[1.0, 0.04, -0.03, 0.97]",
    "fine_pointing.wheels.speed": '"47 Hz"',
    "fine_pointing.wheels.harmonics": "[1.0, 2.1]",
    "fine_pointing.wheels.coefficients": '["0.1 nrad/Hz^2", "0.05 nrad/Hz^2"]',
    "fine_pointing.wheels.convention": '"radial"',
    "fine_pointing.body.convention": '"radial"',
    "fine_pointing.vibration.convention": '"per-axis"',
    "operations.rates": '["80 Mbit/s", "210 Mbit/s", "470 Mbit/s"]',
    "operations.acquisition": '"scan"',
    "operations.relay_share": "0.83",
    "acquisition.scan.pattern": '"raster"',
    "constellation.pattern": '"star"',
    "constellation.terminals": "2",
    "orbit.earth": '"sphere"',
    "orbit.leo.limits.in_eclipse": "false",
    "orbit.duration": '"11 h"',
}
KEPLERIAN = {
    **SHORT,
    **vibration("table"),
    "mirror.composition": '"cascade"',
    "orbit.leo.kind": '"keplerian"',
    "orbit.leo.altitude": None,
    "orbit.leo.local_time": None,
    "orbit.leo.phase": None,
    "orbit.leo.semi_major_axis": '"7050 km"',
    "orbit.leo.eccentricity": "0.013",
    "orbit.leo.inclination": '"63 deg"',
    "orbit.leo.node": '"41 deg"',
    "orbit.leo.argument_of_perigee": '"77 deg"',
    "orbit.leo.mean_anomaly": '"19 deg"',
    "orbit.leo.gravity": '"two-body"',
    "orbit.leo.limits.attitude": '"nadir"',
    "orbit.leo.limits.boresight": "[0.0, 0.3, -1.0]",
    "orbit.leo.limits.field_of_regard": '"71 deg"',
    "orbit.duration": '"9 h"',
    "acquisition.scan.pattern": '"step-stare"',
    "fine_pointing.optical_sensor.quad_cell.received_power": '"70 pW"',
    "point_ahead.corrected": "false",
}
ROUGH = {
    **SHORT,
    **vibration("first-order"),
    "fine_pointing.vibration.level": '"90000 urad^2/Hz"',
    "fine_pointing.vibration.corner": '"40 Hz"',
    "fine_pointing.delay": '"400 us"',
    "fine_pointing.optical_sensor.field_of_view": '"0.4 mrad"',
    "communication.transmit_power": '"0.4 W"',
    "operations.store": '"0.5 GB"',
    "acquisition.lock_probability": "0.5",
    "acquisition.attempts": "2",
    "requirement.pointing_error": '"4 urad"',
}
PLAYS = """
[mirror]
name = "Plays that creep"
travel = "2.3 mrad"
composition = "cascade"
rate_limit = "4.1 kV/s"
bias = "5.3 V"
drive_min = "0.4 V"
drive_max = "11.2 V"

[mirror.linear]
poles = ["1.13 kHz", "2.4 kHz"]
pole_dampings = [0.023, 0.04]
zeros = ["1.9 kHz"]
zero_dampings = [0.031]
normalise_at = "2 Hz"
excited_from = "1 Hz"
excited_to = "1.6 kHz"

[mirror.prandtl_ishlinskii]
thresholds = ["0 V", "0.8 V", "2.7 V"]
weights = ["141 urad/V", "13 urad/V", "4 urad/V"]

[mirror.creep]
time_constants = ["0.03 s", "0.7 s"]
weights = ["2.1 urad/V", "3.3 urad/V"]

[mirror.uncertainty]
parameters = ["prandtl_ishlinskii.weights.1", "prandtl_ishlinskii.weights.3"]
standard_errors = [0.004, 0.11]
correlation = [-0.4]
"""
TRIPOD = {
    **SHORT,
    "fine_pointing.geometry.layout": '"tripod"',
    "fine_pointing.geometry.actuator_radius": '"11 mm"',
    "fine_pointing.geometry.travel_angle": '"mechanical"',
    "fine_pointing.geometry.magnification": "0.9",
    "fine_pointing.optical_sensor.quad_cell.background_power": '"3 pW"',
    "fine_pointing.reference.point_ahead_on_mirror": "false",
    "amplifier.gain": "14",
    "amplifier.output_min": '"-8 V"',
    "amplifier.output_max": '"151 V"',
    "scenario.loop_amplitude": '"4.1 V"',
    "control.proportional": '"0.01 V/mrad"',
    "control.integral": '"160 V/(mrad s)"',
    "conventions.mirror_angle": '"mechanical"',
    "requirement.residual_statistic": '"rms"',
}
COUPLED = {
    **SHORT,
    "fine_pointing.mirror_file": '"two-axes.toml"',
    "fine_pointing.duration": '"0.2 s"',
    "amplifier.gain": "1",
    "amplifier.output_max": '"100 V"',
}
STATIC = {key: value for key, value in SHORT.items() if key.startswith("scenario")} | {
    "mirror.composition": '"static"',
    "communication.data_rate": '"largest"',
    "conventions.residual": '"radial"',
}
BY_FILES = {
    **SHORT,
    "orbit.leo.kind": '"elements"',
    "orbit.leo.file": '"satellites.tle"',
    "orbit.leo.object": '"70001"',
    "orbit.duration": '"7 h"',
    "constellation.pattern": '"file"',
    "constellation.file": '"satellites.tle"',
    "constellation.terminals": "2",
    "operations.downlink.stations.south.latitude": '"-44.2 deg"',
    "operations.downlink.stations.south.longitude": '"-70.6 deg"',
    "operations.downlink.stations.south.height": '"31 m"',
    "operations.downlink.stations.south.mask": '"7 deg"',
    "orbit.geo.limits.sun_exclusion": '"21 deg"',
    **{f"orbit.leo.{key}": None for key in ("altitude", "inclination", "local_time", "phase", "gravity")},
    **{f"constellation.{key}": None for key in ("satellites", "planes", "phasing")},
}


def elements(*sets: tuple[str, str, float, float, int, float, float]) -> str:
    """Element sets of an epoch of the missions: name, number, inclination, node (deg), eccentricity, anomaly, turns."""
    lines = []
    for name, number, inclination, node, eccentricity, anomaly, turns in sets:
        first = f"1 {number}U 26001A   26079.40000000  .00001000  00000-0  50000-4 0  999"
        second = (
            f"2 {number} {inclination:8.4f} {node:8.4f} {eccentricity:07d}  81.0000 {anomaly:8.4f} {turns:11.8f}    1"
        )
        lines += [name, *(f"{line}{_digit(line)}" for line in (first, second))]
    return "\n".join(lines) + "\n"


def _digit(line: str) -> int:
    return sum(int(c) if c.isdigit() else c == "-" for c in line) % 10


SATELLITES = elements(
    ("FIRST", "70001", 97.4, 101.0, 11000, 17.0, 15.21),
    ("SECOND", "70002", 63.1, 222.0, 23000, 140.0, 14.93),
    ("THIRD", "70003", 28.7, 19.0, 4000, 301.0, 15.07),
)
BARE = without(SHIPPED, "acquisition", "orbit", "operations", "constellation", "fine_pointing")

CASES: Mapping[str, Case] = {
    "links": Case(links, quick=False),
    "whole-shipped": Case(whole(SHIPPED, 1, SHORT, *POINTING, *DAY, ("budget", "FILE")), quick=False, simulated=True),
    "whole-additive": Case(whole(PAPER, 2, ADDITIVE, *POINTING, *DAY), quick=False, simulated=True),
    "whole-keplerian": Case(
        whole(
            SHIPPED,
            3,
            KEPLERIAN,
            *POINTING,
            *DAY,
            beside={"spectrum.csv": SPECTRUM},
            more=BUDGET.replace("WITH_LOOP", "true"),
        ),
        quick=False,
        simulated=True,
    ),
    "whole-rough": Case(whole(SHIPPED, 4, ROUGH, *POINTING), quick=False, simulated=True),
    "whole-tripod": Case(
        whole(without(SHIPPED, "mirror", "constellation"), 5, TRIPOD, *POINTING, more=PLAYS),
        quick=False,
        simulated=True,
    ),
    "whole-coupled": Case(
        whole(SHIPPED, 6, COUPLED, *POINTING, beside={"two-axes.toml": TWO_AXES}), quick=False, simulated=True
    ),
    "whole-static": Case(whole(without(BARE, r"mirror\.linear"), 7, STATIC, ("budget", "FILE")), simulated=True),
    "whole-elements": Case(
        whole(SHIPPED, 8, BY_FILES, *DAY, beside={"satellites.tle": SATELLITES}), quick=False, simulated=True
    ),
    "crosslink": Case(crosslink),
    "refused": Case(refused),
}
"""All of them; a file reference/told/NAME.txt each."""
