"""Mirror files of version 2: what a bad one is told, and what the commands say that take one axis."""

import re
from types import SimpleNamespace

import pytest

from made_tables import made, one_line, told
from microrad.mission.fields import ProblemsError, Quantity
from microrad.mission.file import (
    MissionError,
    holds_several_axes,
    load_coupled_mirror,
    load_loop,
    load_mirror,
    load_mission,
    mirror_of_loop,
    with_contents,
)
from microrad.mission.tables import coupled_mirror, coupled_parts
from microrad.mission.tables import mirror as mirror_table
from microrad.mission.tables.coupled_mirror import CoupledMirror, in_order, on_a_line, parameters
from microrad.mission.tables.coupled_parts import (
    ActuatorTable,
    HysteresisTable,
    MatricesTable,
    ModesTable,
    OutputTable,
    RecordingTable,
    UncertaintyTable,
    shape_problems,
)
from microrad.mission.toml import scan
from places import ROOT
from shipped import without_fine_pointing
from waiting import no_hang

PAGE = (ROOT / "docs" / "mirror-file.md").read_text(encoding="utf-8")
EXAMPLES = re.findall(r"```toml\n(.*?)```", PAGE, flags=re.DOTALL)
TEXT = next(text for text in EXAMPLES if text.startswith("version = 2"))
ONE_AXIS = EXAMPLES[0]
MISSION = ROOT / "missions" / "leo-geo.toml"


def edited(*changes):
    """The example with texts replaced, each once."""
    text = TEXT
    for old, new in changes:
        assert old in text, old
        text = text.replace(old, new, 1)
    return text


def loaded(text):
    return load_coupled_mirror("mirror.toml", text=text)


def refusal(text, load=load_coupled_mirror):
    with no_hang(), pytest.raises(MissionError) as refused:
        load("mirror.toml", text=text)
    report = str(refused.value)
    assert "mirror.toml" in report
    assert report.replace("\n", "").isprintable()
    for fault in refused.value.faults:
        assert fault.reason and fault.expected
    return refused.value.faults


UNCERTAIN = TEXT[TEXT.index("[uncertainty]") :]
PARAMETERS = '["modes.decay.1", "modes.frequency.1", "hysteresis.1.weights.3", "recording.delay"]'
CORRELATION = TEXT[TEXT.index("correlation = [") :]
IDENTITY = "[[1.0, 0.0], [0.0, 1.0], [0.6, 0.8], [1.0, 0.0]]"
B = re.search(r"B = \[.*?\n\]", TEXT, re.DOTALL)[0]
C = re.search(r"C = \[.*?\n\]", TEXT, re.DOTALL)[0]
E = re.search(r"E = \[.*?\n\]", TEXT, re.DOTALL)[0]
F = re.search(r"F = \[.*?\n\]", TEXT, re.DOTALL)[0]
PLAYS = TEXT[TEXT.index("[hysteresis.2]") : TEXT.index("[uncertainty]")]
BOUC_WEN = '[hysteresis.2]\nmodel = "bouc-wen"\nd1 = 0.02\nepsilon = -0.01\nalpha = "2 1/V"\nbeta = "0.5 1/V"\n'

FAULTS = {
    # ---- versions
    "an unknown version": (("version = 2", "version = 3"), "version", "is no version", "version = 2 for"),
    "a version in quotes": (("version = 2", 'version = "2"'), "version", "is no version", "version = 2 for"),
    "a version with a point": (("version = 2", "version = 2.0"), "version", "is no version", "version = 2 for"),
    "no version": (("version = 2\n", ""), "version", "is missing", "version = 2 in the first line"),
    "a key of version 1": (
        ("version = 2\n", 'version = 2\ntravel = "2 mrad"\n'),
        "travel",
        "is a key of version 1, in a file of version 2",
        "this line removed",
    ),
    "a range of version 1": (
        ("version = 2\n", 'version = 2\nbias = "5 V"\n'),
        "bias",
        "is a key of version 1",
        "in the table of each actuator",
    ),
    "a table of version 1": (
        ("[modes]", '[linear]\npoles = ["1 Hz"]\n[modes]'),
        "linear",
        "is a key of version 1",
        "[modes] and [matrices] in its place",
    ),
    "hysteresis of version 1": (
        ("[modes]", '[prandtl_ishlinskii]\nthresholds = ["0 V"]\n[modes]'),
        "prandtl_ishlinskii",
        "is a key of version 1",
        'model = "plays"',
    ),
    "a key that is none": (("steps_per_sample", "steps_a_sample"), "recording.steps_a_sample", "is no key", "one of"),
    # ---- channels
    "a bias below the range": (
        ('bias = "50 V" ', 'bias = "-1 mV" '),
        "actuators.1.bias",
        "is outside drive_min to drive_max (0 V to 100 V)",
        "0 V to 100 V",
    ),
    "a range of nothing": (
        ('drive_max = "100 V"', 'drive_max = "0 V"'),
        "actuators.1.drive_max",
        "is not above drive_min (0 V)",
        "a voltage above 0 V",
    ),
    "a bias out of range": (
        ('bias = "50 V" ', 'bias = "150 V" '),
        "actuators.1.bias",
        "is outside drive_min to drive_max (0 V to 100 V)",
        "0 V to 100 V",
    ),
    "a range that falls": (
        ('drive_max = "100 V"', 'drive_max = "-1 V"'),
        "actuators.1.drive_max",
        "is not above drive_min",
        "above 0 V",
    ),
    "a number without its unit": (
        ('rate_limit = "20 kV/s"', "rate_limit = 20.0"),
        "actuators.1.rate_limit",
        "is a number without a unit",
        'rate_limit = "20 V/us"',
    ),
    "an actuator left out": (
        ("[actuators.2]", "[actuators.3]"),
        "actuators",
        'has "3" where its 2 tables are counted from 1',
        "[actuators.1], [actuators.2]",
    ),
    "a name that stands twice": (
        ('name = "tilt about y"', 'name = "tilt about x"'),
        "actuators",
        'two tables of the name "tilt about x"',
        "a name of its own",
    ),
    "another quantity": (
        ('quantity = "displacement"', 'quantity = "displacment"'),
        "outputs.1.quantity",
        "is none of the choices",
        'quantity = "displacement"',
    ),
    "a band beyond half the rate": (
        ('excited_to = "500 Hz"', 'excited_to = "2 kHz"'),
        "recording.excited_to",
        "is above half the rate (1 kHz)",
        "at most 1 kHz",
    ),
    "a band of one frequency": (
        ('excited_from = "1 Hz"', 'excited_from = "500 Hz"'),
        "recording.excited_to",
        "is not above excited_from",
        "a band that goes up",
    ),
    "a band that falls": (
        ('excited_from = "1 Hz"', 'excited_from = "700 Hz"'),
        "recording.excited_to",
        "is not above excited_from",
        "a band that goes up",
    ),
    "part of a step": (
        ("steps_per_sample = 4", "steps_per_sample = 4.5"),
        "recording.steps_per_sample",
        "is not a whole number",
        "from 1 to 1000",
    ),
    # ---- geometry
    "sensors on one line": (
        ('["-15 mm", "-26 mm"]', '["-60 mm", "52 mm"]'),
        "outputs",
        "has all displacements on one line, so a tilt about that line moves none",
        "three displacements with a position, not on one line",
    ),
    "a sensor without a place": (
        ('position = ["-15 mm", "-26 mm"]\n', ""),
        "outputs.3.position",
        "is missing, while other displacements have one",
        "of each displacement, or of none",
    ),
    "a place in space": (
        ('["-15 mm", "-26 mm"]', '["-15 mm", "-26 mm", "2 mm"]'),
        "outputs.3.position",
        "has 3 coordinates",
        "x and y in the plane",
    ),
    # ---- modes
    "an unstable pole": (
        ('["18 1/s", "21 1/s"]', '["18 1/s", "-21 1/s"]'),
        "modes.decay",
        "item 2 is -21 1/s: an unstable mode",
        "above 0 1/s",
    ),
    "a pole at 0": (
        ('["18 1/s"', '["0 1/s"'),
        "modes.decay",
        "item 1 is 0 1/s: an unstable mode",
        "above 0 1/s",
    ),
    "a decay in Hz": (('["18 1/s"', '["18 Hz"'), "modes.decay", 'item 1: "18 Hz" is in "Hz"', "1/s"),
    "a decay too many": (
        ('["18 1/s", ', '["18 1/s", "5 1/s", '),
        "modes.frequency",
        "has 2 items where decay has 3",
        '"0 rad/s" for a real one',
    ),
    # ---- matrices
    "a row too many": (
        ("B = [", "B = [[1.0, 1.0],"),
        "matrices.B",
        "has 5 rows where there are 4 states",
        "one row for each, in order",
    ),
    "a number too few": (
        ("[25.0, -950.0]", "[25.0]"),
        "matrices.B",
        "row 4 has 1 numbers where there are 2 actuators",
        "2 numbers in each row",
    ),
    "rows that are all too long": (
        (F, "F = [[1.0, 0.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0, 0.0]]"),
        "matrices.F",
        "row 1 has 5 numbers where there are 4 states; 1 other rows do not fit, either",
        "4 numbers in each row",
    ),
    "an output too few": (
        (C, "C = [[1.0, 0.0, 0.0, 0.0]]"),
        "matrices.C",
        "has 1 rows where there are 3 outputs",
        "row",
    ),
    "a text in a matrix": (
        ("[25.0, -950.0]", '[25.0, "x"]'),
        "matrices.B",
        "row 4: item 2",
        "a list of rows, each a list of numbers",
    ),
    "a number that is none": (("[25.0, -950.0]", "[25.0, nan]"), "matrices.B", "row 4: item 2", "numbers"),
    "a matrix in one row": ((B, "B = [1.0, 2.0]"), "matrices.B", "is no list of rows", "[[1.0, 0.0], [0.0, 1.0]]"),
    "a matrix of one number": ((B, "B = 1.0"), "matrices.B", "is no list of rows", "[[1.0, 0.0], [0.0, 1.0]]"),
    "a matrix of nothing": ((B, "B = []"), "matrices.B", "is no list of rows", "[[1.0, 0.0], [0.0, 1.0]]"),
    "no C": ((C, ""), "matrices", "has no C, so none of the 4 states is seen", "a row for each output"),
    # ---- hysteresis
    "an operator that acts on nothing": (
        (E, "E = [[0.0, 0.0], [-900.0, 0.0], [0.0, 0.0], [0.0, 0.0]]"),
        "hysteresis.2",
        "acts on nothing: column 2 of E and of K is zero",
        "a number other than 0 there",
    ),
    "an operator that nothing drives": (
        (F, "F = [[0.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]]"),
        "hysteresis.1",
        "is driven by nothing: row 1 of F and of G is zero",
        "a number other than 0 there",
    ),
    "weights of nothing": (
        ("weights = [0.03, 0.03, 0.04]", "weights = [0.0, 0.0, 0.0]"),
        "hysteresis.1.weights",
        "is zero throughout, so the element acts on nothing",
        "a weight other than 0",
    ),
    "thresholds that fall": (
        ('["0.5 V", "2 V", "8 V"]', '["0.5 V", "8 V", "2 V"]'),
        "hysteresis.1.thresholds",
        "does not rise",
        "rising",
    ),
    "thresholds below 0": (
        ('["0.5 V", "2 V"', '["-0.5 V", "2 V"'),
        "hysteresis.1.thresholds",
        "is below 0 V",
        "at least 0 V",
    ),
    "a weight too few": (
        ("weights = [0.03, 0.03, 0.04]", "weights = [0.03, 0.03]"),
        "hysteresis.1.weights",
        "has 2 items where thresholds has 3",
        "one weight for each threshold",
    ),
    "a polynomial without a reach": (
        ("weights = [0.03, 0.03, 0.04]", "weights = [0.03, 0.03, 0.04]\npolynomial = [0.0, 0.01, 0.0]"),
        "hysteresis.1.reach",
        "is missing beside polynomial",
        'reach = "2 V"',
    ),
    "a reach without a polynomial": (
        ("weights = [0.03, 0.03, 0.04]", 'weights = [0.03, 0.03, 0.04]\nreach = "1 V"'),
        "hysteresis.1.polynomial",
        "is missing beside reach",
        "polynomial = [0.0, 0.01, -0.02]",
    ),
    "a polynomial of two": (
        ("weights = [0.03, 0.03, 0.04]", 'weights = [0.03, 0.03, 0.04]\npolynomial = [0.0, 0.01]\nreach = "1 V"'),
        "hysteresis.1.polynomial",
        "has 2 items",
        "three: of s^2, of |s| s and of s^3",
    ),
    "a reach of nothing": (
        ("weights = [0.03, 0.03, 0.04]", 'weights = [0.03, 0.03, 0.04]\npolynomial = [0, 0.1, 0]\nreach = "0 V"'),
        "hysteresis.1.reach",
        "is not above 0 V",
        "above 0 V",
    ),
    "a key of the other model": (
        ("weights = [0.03, 0.03, 0.04]", "weights = [0.03, 0.03, 0.04]\nd1 = 0.1"),
        "hysteresis.1.d1",
        'does not belong to model = "plays"',
        'or model = "bouc-wen"',
    ),
    "plays without weights": (
        ("weights = [0.03, 0.03, 0.04]", ""),
        "hysteresis.1.weights",
        'is missing, and model = "plays" needs it',
        "weights = [0.8, 0.1]",
    ),
    "plays without thresholds": (
        ('thresholds = ["0.5 V", "2 V", "8 V"]\nweights = [0.03', "weights = [0.03"),
        "hysteresis.1.thresholds",
        'is missing, and model = "plays" needs it',
        'thresholds = ["0 V", "1 V"]',
    ),
    "a Bouc-Wen model without alpha": (
        (PLAYS, BOUC_WEN.replace('alpha = "2 1/V"\n', "")),
        "hysteresis.2.alpha",
        'is missing, and model = "bouc-wen" needs it',
        'alpha = "2 1/V"',
    ),
    "a Bouc-Wen model without beta": (
        (PLAYS, BOUC_WEN.replace('beta = "0.5 1/V"\n', "")),
        "hysteresis.2.beta",
        'is missing, and model = "bouc-wen" needs it',
        'beta = "0.5 1/V"',
    ),
    "a Bouc-Wen model that does not decay": (
        (PLAYS, BOUC_WEN.replace("0.5 1/V", "-2 1/V")),
        "hysteresis.2.alpha",
        "is not above what beta, gamma and eta take off it (2 1/V), so h would grow without bound",
        "above 2 1/V",
    ),
    "a Bouc-Wen model that grows on one side": (
        (PLAYS, f'{BOUC_WEN}gamma = "1.5 1/V"\n'),
        "hysteresis.2.alpha",
        "is not above what beta, gamma and eta take off it (2 1/V)",
        "above 2 1/V",
    ),
    "a Bouc-Wen model that grows in one direction": (
        (PLAYS, f'{BOUC_WEN}eta = "-1.5 1/V"\n'),
        "hysteresis.2.alpha",
        "is not above what beta, gamma and eta take off it (2 1/V)",
        "above 2 1/V",
    ),
    "a Bouc-Wen model that grows": (
        (PLAYS, BOUC_WEN.replace("0.5 1/V", "2.5 1/V")),
        "hysteresis.2.alpha",
        "h would grow without bound",
        "above 2.5 1/V",
    ),
    "a Bouc-Wen model of nothing": (
        (PLAYS, BOUC_WEN.replace("0.02", "0.0").replace("-0.01", "0.0")),
        "hysteresis.2.d1",
        "acts on nothing",
        "one of them other than 0",
    ),
    "a rate without a limit": (
        (PLAYS, f'{BOUC_WEN}delta = "1e-4 s/V"\n'),
        "hysteresis.2.rate_limit",
        "the element depends on the rate",
        'rate_limit = "1 kV/s"',
    ),
    "plays that widen without a limit": (
        ("weights = [0.03, 0.03, 0.04]", 'weights = [0.03, 0.03, 0.04]\nwidening = "1 us"'),
        "hysteresis.1.rate_limit",
        "is missing, and the element depends on the rate",
        'rate_limit = "1 kV/s"',
    ),
    "a gain with the rate without a limit": (
        (PLAYS, f'{BOUC_WEN}d2 = "-1e-4 s/V"\n'),
        "hysteresis.2.rate_limit",
        "is missing, and the element depends on the rate",
        'rate_limit = "1 kV/s"',
    ),
    "plays that widen with what is fed back": (
        ("weights = [0.03, 0.03, 0.04]", 'weights = [0.03, 0.03, 0.04]\nwidening = "1 us"\nrate_limit = "1 kV/s"'),
        "hysteresis.1.widening",
        "makes an element depend on the rate that row 1 of F feeds back",
        "this line removed, or a row of zeros in F",
    ),
    "a gain with the rate that is fed back": (
        (PLAYS, f'{BOUC_WEN}d2 = "1e-4 s/V"\nrate_limit = "1 kV/s"\n'),
        "hysteresis.2.d2",
        "row 2 of F feeds back",
        "this line removed, or a row of zeros in F",
    ),
    "a rate that is fed back": (
        (PLAYS, f'{BOUC_WEN}delta = "1e-4 s/V"\nrate_limit = "1 kV/s"\n'),
        "hysteresis.2.delta",
        "row 2 of F feeds back",
        "this line removed, or a row of zeros in F",
    ),
    "a stiffness that runs away": (
        ("weights = [0.03, 0.03, 0.04]", "weights = [0.5, 0.5, 0.4]"),
        "hysteresis",
        "makes the mirror run away: where its elements slide it grows by",
        "smaller weights",
    ),
    "a Bouc-Wen stiffness that runs away": (
        (PLAYS, BOUC_WEN.replace("0.02", "1.3")),
        "hysteresis",
        "makes the mirror run away",
        "smaller weights",
    ),
    # ---- uncertainty
    "a name that is not in the mirror": (
        ("hysteresis.1.weights.3", "hysteresis.1.weights.4"),
        "uncertainty.parameters",
        'has "hysteresis.1.weights.4", which is no parameter of this mirror',
        'such as "hysteresis.1.weights.',
    ),
    "a name that is like no other": (
        ("hysteresis.1.weights.3", "zzz"),
        "uncertainty.parameters",
        'has "zzz", which is no parameter of this mirror',
        'such as "modes.decay.1"',
    ),
    "a name that stands twice among the parameters": (
        ('"hysteresis.1.weights.3"', '"modes.decay.1"'),
        "uncertainty.parameters",
        'has "modes.decay.1" more than once',
        "each parameter once",
    ),
    "a negative error": (
        ("standard_errors = [0.4", "standard_errors = [-0.4"),
        "uncertainty.standard_errors",
        "item 1: -0.4 is below 0",
        "at least 0",
    ),
    "an error too few": (
        ("standard_errors = [0.4, ", "standard_errors = ["),
        "uncertainty.standard_errors",
        "has 3 items where parameters has 4",
        "one standard error for each parameter",
    ),
    "a correlation that is none": (
        ("-0.2, 0.6,", "-0.99, 0.99,"),
        "uncertainty.correlation",
        "is not positive semidefinite: its smallest eigenvalue is -",
        "as the fit gave them",
    ),
    "a correlation beyond 1": (("-0.2, 0.6,", "-1.2, 0.6,"), "uncertainty.correlation", "is below -1", "at least -1"),
    "a correlation too short": (
        ("-0.2, 0.6,", "-0.2,"),
        "uncertainty.correlation",
        "has 5 items where 4 parameters have 6 pairs",
        "6 numbers, the lower triangle",
    ),
    "both forms of a correlation": (
        (CORRELATION, f"factor = {IDENTITY}\n{CORRELATION}"),
        "uncertainty.correlation",
        "stands beside factor",
        "one of the two removed",
    ),
    "a factor of other lengths": (
        (CORRELATION, f"factor = {IDENTITY.replace('0.6', '0.7')}\n"),
        "uncertainty.factor",
        "row 3 has the length 1.063015, so the correlation with itself is not 1",
        "rows of length 1",
    ),
    "a factor too short": (
        (CORRELATION, "factor = [[1.0, 0.0], [0.0, 1.0], [0.6, 0.8]]\n"),
        "uncertainty.factor",
        "has 3 rows where there are 4 parameters",
        "one row for each",
    ),
    "a factor that is ragged": (
        (CORRELATION, "factor = [[1.0, 0.0], [0.0, 1.0], [0.6, 0.8], [1.0]]\n"),
        "uncertainty.factor",
        "row 4 has 1 numbers where there are 2 numbers in row 1",
        "2 numbers in each row",
    ),
}


@pytest.mark.promise(
    "mirror-file-1",
    "mirror-file-5",
    "mirror-file-33",
    "mirror-file-39",
    "mirror-file-40",
    "mirror-file-41",
    "mirror-file-42",
    "mirror-file-43",
    "mirror-file-44",
    "mirror-file-45",
    "mirror-file-46",
    "mirror-file-47",
    "mirror-file-48",
    "mirror-file-49",
    "mirror-file-51",
)
@pytest.mark.parametrize("name", FAULTS)
def test_what_is_wrong_is_told_once_with_its_key_and_a_remedy(name):
    change, key, reason, expected = FAULTS[name]
    text = edited(change)
    faults = refusal(text)
    assert [fault.key for fault in faults] == [f"mirror.{key}"]
    fault = faults[0]
    assert reason in fault.reason
    assert expected in fault.expected or expected in fault.reason
    lines = {statement.key: statement.line for statement in scan(text)}
    parts = key.split(".")
    there = [".".join(parts[:n]) for n in range(len(parts), 0, -1) if ".".join(parts[:n]) in lines]
    there += [each for each in lines if each.startswith(f"{key}.")]  # a table that only has others inside it
    assert fault.line == (lines[there[0]] if there else 0)


WEIGHTS = "weights = [0.03, 0.03, 0.04]"
AT_A_LIMIT = {
    "a bias at the lowest drive": [('bias = "50 V" ', 'bias = "0 V" ')],
    "a bias at the highest drive": [('bias = "50 V" ', 'bias = "100 V" ')],
    "a band up to half the rate": [('excited_to = "500 Hz"', 'excited_to = "1 kHz"')],
    "a polynomial alone": [(WEIGHTS, 'weights = [0.0, 0.0, 0.0]\npolynomial = [0, 0.1, 0]\nreach = "1 V"')],
    "a gain alone": [(PLAYS, BOUC_WEN.replace("-0.01", "0.0"))],
    "a slope alone": [(PLAYS, BOUC_WEN.replace("0.02", "0.0"))],
    "a decay above what takes off it": [(PLAYS, BOUC_WEN.replace("0.5 1/V", "-1.999 1/V"))],
    "an exponent of 1": [(PLAYS, f"{BOUC_WEN}exponent = 1.0\n")],
    "an exponent of 100": [(PLAYS, f"{BOUC_WEN}exponent = 100.0\n")],
    "rates of 0 without a limit": [(PLAYS, f'{BOUC_WEN}d2 = "0 s/V"\ndelta = "0 s/V"\n')],
    "an element that acts on an output alone": [
        (E, "E = [[0.0, 0.0], [-900.0, 0.0], [0.0, 0.0], [0.0, 0.0]]\nK = [[0.0, 0.0], [0.0, 0.0], [0.0, 1.0]]")
    ],
    "an element that a drive alone feeds": [
        (F, "F = [[1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 0.0]]\nG = [[0.0, 0.0], [0.0, 1.0]]")
    ],
}


@pytest.mark.parametrize("name", AT_A_LIMIT)
def test_what_meets_a_limit_is_taken(name):
    assert loaded(edited(*AT_A_LIMIT[name])).states == 4


@pytest.mark.promise("mirror-file-5", "mirror-file-29")
def test_faults_of_all_tables_are_told_together():
    text = edited(
        ("version = 2", "version = 2\ncreep = 1"),
        ('["18 1/s"', '["-18 1/s"'),
        ('bias = "50 V" ', 'bais = "50 V" '),
        ("[25.0, -950.0]", '[25.0, "x"]'),
        ('model = "plays"', 'model = "play"'),
    )
    told = {(fault.key, fault.nearest) for fault in refusal(text)}
    assert told == {
        ("mirror.creep", ""),
        ("mirror.modes.decay", ""),
        ("mirror.actuators.1.bais", "bias"),
        ("mirror.matrices.B", ""),
        ("mirror.hysteresis.1.model", '"plays"'),
    }


@pytest.mark.promise("mirror-file-45")
def test_what_stands_without_its_table_is_told_for_each_matrix():
    modes = TEXT[TEXT.index("[modes]") : TEXT.index("[matrices]")]
    keys = {fault.key: fault.reason for fault in refusal(edited((modes, "")))}
    assert set(keys) == {f"mirror.matrices.{name}" for name in "BCEF"}
    assert set(keys.values()) == {"stands without a table [modes]"}
    elements = TEXT[TEXT.index("[hysteresis.1]") : TEXT.index("[uncertainty]")]
    keys = {
        fault.key: fault.reason
        for fault in refusal(edited((elements, ""), ("hysteresis.1.weights.3", "modes.decay.2")))
    }
    assert set(keys) == {"mirror.matrices.E", "mirror.matrices.F"}
    assert set(keys.values()) == {"stands without a table [hysteresis.1]"}


@pytest.mark.promise("mirror-file-51")
def test_rows_of_another_length_are_told_once():
    rows = ", ".join(["[0.5, 0.5]"] * 2 + ["[0.6, 0.8]"] + ["[1.0, 1.0]"])
    fault = only_fault(lambda: loaded(edited((CORRELATION, f"factor = [{rows}]\n"))))
    assert fault.key == "mirror.uncertainty.factor"
    assert fault.reason.startswith("row 1 has the length 0.7071068, so the correlation with itself is not 1")
    assert fault.reason.endswith("; 3 of 4 rows have another length than 1")


@pytest.mark.promise("mirror-file-42")
def test_two_displacements_with_places_are_too_few():
    third = TEXT[TEXT.index("[outputs.3]") : TEXT.index("[recording]")]
    faults = refusal(edited((third, ""), (C, "C = [[0.0, 0.0, -3.0e-6, 0.0], [2.6e-6, 0.0, 1.5e-6, 0.0]]")))
    assert [fault.key for fault in faults] == ["mirror.outputs"]
    assert "has 2 displacements with a position, too few for two tilts and a piston" in faults[0].reason
    unplaced = edited((third, ""), (C, "C = [[1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]]"))
    assert len(loaded(re.sub(r"position = .*\n", "", unplaced)).outputs) == 2


@pytest.mark.promise("mirror-file-12", "mirror-file-40", "mirror-file-41", "mirror-file-42")
@pytest.mark.parametrize("name", ["Two axes on a hysteretic spring", "tilt about x", "sensor at 0 degrees", "Tip-tilt"])
def test_a_name_has_200_characters_at_most_and_one_at_least(name, tmp_path):
    text, old = (ONE_AXIS, "Tip-tilt stage, axis x") if name == "Tip-tilt" else (TEXT, name)

    def load(new):
        assert text.count(f'name = "{old}"') == 1
        path = tmp_path / "mirror.toml"
        path.write_text(text.replace(f'name = "{old}"', f'name = "{new}"'), encoding="utf-8")
        (load_mirror if text == ONE_AXIS else load_coupled_mirror)(path)

    load("n" * 200)
    assert only_fault(lambda: load("")).key.endswith("name")
    assert only_fault(lambda: load("n" * 201)).key.endswith("name")


@pytest.mark.promise("mirror-file-40")
@pytest.mark.parametrize("key", ["actuators", "outputs"])
def test_a_mirror_has_an_actuator_and_an_output_at_least(key):
    first, last = TEXT.index(f"[{key}.1]"), TEXT.index({"actuators": "[outputs.1]", "outputs": "[recording]"}[key])
    fault = only_fault(lambda: loaded(f"{TEXT[:first]}[{key}]\n{TEXT[last:]}"))
    assert (fault.key, fault.reason) == (f"mirror.{key}", "is empty")


@pytest.mark.promise("mirror-file-40")
def test_a_hundred_modes_are_taken_and_one_more_is_not():
    def of(count):
        return {"decay": ["1 1/s"] * count, "frequency": ["0 rad/s"] * count}

    assert ModesTable.model_validate(of(100)).states == 100
    with pytest.raises(ValueError, match="is a list of 101 items"):
        ModesTable.model_validate(of(101))


@pytest.mark.promise("mirror-file-43")
@pytest.mark.parametrize(("steps", "taken"), [(1, True), (1000, True), (0, False), (1001, False)])
def test_steps_of_a_sample_are_one_to_a_thousand(steps, taken):
    text = edited(("steps_per_sample = 4", f"steps_per_sample = {steps}"))
    if taken:
        assert loaded(text).recording.steps_per_sample == steps
    else:
        assert only_fault(lambda: loaded(text)).key == "mirror.recording.steps_per_sample"


@pytest.mark.promise("mirror-file-52")
def test_a_file_of_several_axes_may_have_four_times_the_bytes_of_a_mission(tmp_path):
    path = tmp_path / "mirror.toml"

    def filled(text, size):
        path.write_text(text + "#" * (size - len(text)), encoding="utf-8")

    filled(TEXT, 4_000_000)
    assert load_coupled_mirror(path).states == 4
    filled(TEXT, 4_000_001)
    assert "larger than 4000 kB" in only_fault(lambda: load_coupled_mirror(path)).reason
    filled(MISSION.read_text(encoding="utf-8"), 1_000_001)
    assert "larger than 1000 kB" in only_fault(lambda: load_mission(path)).reason


@pytest.mark.promise("mirror-file-42")
def test_an_angle_has_no_place():
    faults = refusal(edited(('quantity = "displacement"', 'quantity = "angle"')))
    assert [fault.key for fault in faults] == ["mirror.outputs.1.position"]
    assert "an angle, which is alike everywhere" in faults[0].reason


@pytest.mark.promise("mirror-file-48")
def test_a_rate_that_nothing_feeds_back_is_taken():
    """The same element that is refused in the stiffness, driven by the drive alone."""
    element = f'{BOUC_WEN}delta = "1e-4 s/V"\nrate_limit = "1 kV/s"\n'
    rows = "F = [[1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 0.0]]\nG = [[0.0, 0.0], [0.0, 1.0]]"
    assert loaded(edited((PLAYS, element), (F, rows))).hysteresis["2"].delta_s_v == 1e-4


@pytest.mark.promise("mirror-file-39")
def test_a_stiffness_at_the_edge_of_running_away():
    """The pair -18 +- 900i with E W F: stable while the weights sum to less than 1, as x2' = (1 - W) 900 x1 - 18 x2."""
    for last, stable in (("0.9395", True), ("0.941", False)):
        text = edited(("weights = [0.03, 0.03, 0.04]", f"weights = [0.03, 0.03, {last}]"))
        if stable:
            assert loaded(text).states == 4
        else:
            assert "run away" in refusal(text)[0].reason


def one_mode(**element):
    """A mirror of one real mode of 1 1/s, which is its own element's drive."""
    actuator = {"name": "a", "bias": "0 V", "drive_min": "-1 V", "drive_max": "1 V", "rate_limit": "1 V/s"}
    recording = {"delay": "0 s", "rate": "1 kHz", "steps_per_sample": 1}
    return {
        "version": 2,
        "name": "one mode",
        "actuators": {"1": actuator},
        "outputs": {"1": {"name": "o", "quantity": "angle"}},
        "recording": {**recording, "excited_from": "1 Hz", "excited_to": "10 Hz"},
        "modes": {"decay": ["1 1/s"], "frequency": ["0 rad/s"]},
        "matrices": {"B": [[1.0]], "C": [[1.0]], "E": [[1.0]], "F": [[1.0]]},
        "hysteresis": {"1": element},
    }


@pytest.mark.parametrize(("of", "stable"), [(0.5, True), (0.999, True), (1.0, False), (1.5, False)])
def test_a_mode_that_neither_dies_out_nor_grows_is_refused(of, stable):
    """x' = -x + gain x: the gain of a Bouc-Wen model for large drives is d1, that of plays the sum of their weights."""
    for element in (
        {"model": "bouc-wen", "d1": of, "epsilon": -0.1, "alpha": "2 1/V", "beta": "0.5 1/V"},
        {"model": "plays", "thresholds": ["0 V", "1 V"], "weights": [of - 0.25, 0.25]},
        {"model": "plays", "thresholds": ["0 V"], "weights": [of]},
    ):
        if stable:
            assert CoupledMirror.model_validate(one_mode(**element)).states == 1
        else:
            with pytest.raises(ValueError, match="makes the mirror run away: where its elements slide it grows by"):
                CoupledMirror.model_validate(one_mode(**element))


@pytest.mark.parametrize(
    ("weights", "polynomial", "gain"),
    [([0.5, 0.25], None, 0.5), ([0.0, 0.25], None, 0.0), ([0.0, 0.0], [0.0, 0.1, 0.0], 0.0)],
)
def test_the_play_without_a_threshold_is_the_linear_gain(weights, polynomial, gain):
    table = {"model": "plays", "thresholds": ["0 V", "1 V"], "weights": weights}
    more = {} if polynomial is None else {"polynomial": polynomial, "reach": "2 V"}
    assert HysteresisTable.model_validate({**table, **more}).linear_gain == gain


def test_a_matrix_has_so_many_rows_and_no_more(monkeypatch):
    monkeypatch.setattr(coupled_parts, "_MANY", 3)
    rule = coupled_parts._Matrix(Quantity(""))
    assert rule.read([[1.0], [2.0], [3.0]]) == ((1.0,), (2.0,), (3.0,))
    assert [type(item) for row in rule.read([[1, 2], [3, 4]]) for item in row] == [float] * 4
    with pytest.raises(ProblemsError) as refused:
        rule.read([[1.0]] * 4)
    assert [(p.reason, p.expected) for p in refused.value.problems] == [("has 4 rows", "at most 3 rows")]


@pytest.mark.parametrize(("height", "alike"), [(0.0, True), (8.6e-5, True), (8.7e-5, False), (1.0, False)])
def test_places_lie_on_a_line_up_to_a_ten_thousandth_of_its_length(height, alike):
    """Of (0, 0), (1, 0) and (1/2, h) the spread across the line is 2 h / sqrt 3 of that along it."""
    for k in (1.0, -1.0, 1e-3):
        assert on_a_line([(0.0, 0.0), (k, 0.0), (0.5 * k, height * k)]) == alike


def uncertain(**more):
    """Three parameters of some mirror."""
    known = {"parameters": ["a", "b", "c"], "standard_errors": [0.1, 0.0, 0.1]}
    return UncertaintyTable.model_validate({**known, **more})


@pytest.mark.parametrize("length", [1.0 + 0.9e-6, 1.0 - 0.9e-6])
def test_a_row_of_a_factor_may_miss_its_length_by_a_millionth(length):
    assert uncertain(factor=[[1.0], [length], [-1.0]]).factor[1] == (length,)
    further = 1.0 + 1.2 * (length - 1.0)
    with pytest.raises(ValueError, match=f"row 2 has the length {further:.7g}, so the correlation with itself is not"):
        uncertain(factor=[[1.0], [further], [-1.0]])


def test_a_correlation_may_be_indefinite_by_what_two_decimals_leave():
    """Three values of one correlation r to each other have the eigenvalues 1 - r and 1 + 2 r."""
    for each in (-1.0, 1.0):
        assert uncertain(correlation=[each, each, 1.0]).correlation_matrix[0, 1] == each
    assert uncertain(correlation=[-0.504] * 3).correlation_matrix.tolist()[2] == [-0.504, -0.504, 1.0]
    with pytest.raises(ValueError, match=r"is not positive semidefinite: its smallest eigenvalue is -0\.012"):
        uncertain(correlation=[-0.506] * 3)


@pytest.mark.promise("mirror-file-50")
def test_parameters_are_named_with_their_values():
    found = parameters(loaded(TEXT))
    assert found["modes.decay.2"] == 21.0
    assert found["modes.frequency.1"] == 900.0
    assert found["matrices.B.4.1"] == 25.0
    assert found["hysteresis.2.thresholds.3"] == 8.0
    assert found["hysteresis.1.weights.3"] == 0.04
    assert found["recording.delay"] == 70e-6
    assert len(found) == 1 + 4 + 8 + 12 + 8 + 8 + 12
    matrices = TEXT[TEXT.index("[matrices]") : TEXT.index("[hysteresis.1]")]
    static = "[matrices]\nC = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]\nG = [[1.0, 0.0], [0.0, 1.0]]\n"
    added = f"{static}K = [[1.0, 0.0], [0.0, 1.0], [0.0, 0.0]]\n"
    real = loaded(edited(('"950 rad/s"', '"0 rad/s"'), (matrices, added)))
    assert real.states == 3
    assert "modes.frequency.2" not in parameters(real)


ERRORS = "standard_errors = [0.4, 0.9, 0.004, 2.0e-6]"
ENDLESS = {
    "errors": (ERRORS, "standard_errors = [" + "0.1, " * 100_000 + "]", "uncertainty.standard_errors"),
    "a row": (B, "B = [[" + "0.1, " * 100_000 + "]]", "matrices.B"),
    "rows": (B, "B = [" + "[0.1], " * 100_000 + "]", "matrices.B"),
    "rows of texts": (B, "B = [" + '["x", "y"], ' * 19_000 + "]", "matrices.B"),
    "names": (PARAMETERS, "[" + ", ".join(f'"a{i}"' for i in range(19_999)) + "]", "uncertainty.parameters"),
}


@pytest.mark.parametrize("name", ENDLESS)
def test_lists_without_end_are_refused_in_little_time_and_few_words(name):
    old, new, key = ENDLESS[name]
    faults = [fault for fault in refusal(edited((old, new))) if fault.key == f"mirror.{key}"]
    assert 1 <= len(faults) <= 21
    assert len(str(MissionError(ROOT, faults))) < 10_000


def test_the_schema_has_every_key():
    schema = CoupledMirror.model_json_schema(by_alias=True)
    assert set(schema["properties"]) == {key.partition(".")[0].strip() for key in CoupledMirror.model_fields}
    assert schema["properties"]["version"] == {
        "description": "2: a mirror of several axes",
        "type": "integer",
        "minimum": 2,
        "maximum": 2,
        "title": "Version",
    }


# ------------------------------------------------------------------------------------------- where one axis is wanted
HELD = "holds a mirror of several axes (2 actuators, 3 outputs, 4 states), and the paper's loop has one"


@pytest.fixture
def several(tmp_path):
    path = tmp_path / "two-axes.toml"
    path.write_text(TEXT, encoding="utf-8")
    return path


def only_fault(load):
    with pytest.raises(MissionError) as refused:
        load()
    assert len(refused.value.faults) == 1
    return refused.value.faults[0]


def is_the_refusal(fault, path):
    assert fault.key == "mirror.version"
    assert fault.file.endswith(path.name)
    assert fault.line == 1
    assert HELD in fault.reason
    assert "fine_pointing.mirror_file" in fault.expected


@pytest.mark.promise("mirror-file-31")
def test_a_file_of_several_axes_is_no_mirror_of_a_study(several, tmp_path):
    is_the_refusal(only_fault(lambda: load_mirror(several)), several)
    is_the_refusal(only_fault(lambda: load_mission(MISSION, several)), several)
    text = MISSION.read_text(encoding="utf-8")
    named = re.sub(r"\[mirror\]\n.*?(?=\n\[(?!mirror))", '[mirror]\nfile = "two-axes.toml"\n', text, flags=re.DOTALL)
    assert named != text
    is_the_refusal(only_fault(lambda: load_mission(tmp_path / "mission.toml", text=named)), several)


@pytest.mark.promise("mirror-file-31")
@pytest.mark.parametrize("command", [("run",)])
def test_commands_of_one_axis_say_what_they_cannot_do(folder, several, refused, command):
    """Exit code 2, the file with what it holds and what reads it; nothing is written."""
    told = refused(*command, MISSION, "--mirror", several.name)
    assert "1 fault to correct" in told
    assert f"{several.name}, line 1: mirror.version = 2" in told
    assert HELD in told
    assert "fine_pointing.mirror_file" in told
    assert [path.name for path in folder.iterdir()] == [several.name]


@pytest.mark.promise("mirror-file-31")
def test_a_mirror_of_several_axes_inside_a_mission_is_refused():
    text = MISSION.read_text(encoding="utf-8").replace("[mirror]\n", "[mirror]\nversion = 2\n")
    fault = only_fault(lambda: load_mission(MISSION, text=text))
    assert fault.key == "mirror.version"
    assert fault.reason.startswith("holds a mirror of several axes, ")
    assert fault.line == next(s.line for s in scan(text) if s.key == "mirror.version")


@pytest.mark.promise("mirror-file-1", "mirror-file-2", "mirror-file-5")
def test_keys_of_version_2_in_a_mirror_of_one_axis(tmp_path):
    def told(text):
        (tmp_path / "mirror.toml").write_text(text, encoding="utf-8")
        with pytest.raises(MissionError) as refused:
            load_mirror(tmp_path / "mirror.toml")
        return [(fault.key, fault.reason) for fault in refused.value.faults]

    foreign = "is a key of version 2, in a mirror of one axis"
    assert told(f'{ONE_AXIS}\n[modes]\ndecay = ["1 1/s"]\n[matrices]\n') == [
        ("mirror.modes", foreign),
        ("mirror.matrices", foreign),
    ]
    largest = f"{ONE_AXIS}\n#".ljust(1_000_000)
    assert told(f"{largest} ") == [("", "the mirror file is larger than 1000 kB")]
    (tmp_path / "mirror.toml").write_text(largest, encoding="utf-8")
    assert load_mirror(tmp_path / "mirror.toml").text == largest
    unknown = "is no version of a mirror of one axis"
    assert told(f"version = 1\n{ONE_AXIS}") == [("mirror.version", unknown)]
    for none in ("true", "false", "0", '""'):
        assert told(f"version = {none}\n{ONE_AXIS}") == [("mirror.version", unknown)]
    assert told(edited(("version = 2\n", ""))) == [
        ("mirror.version", "is missing, and actuators is a key of version 2")
    ]
    for other in ("5", "2.0", '"2"'):
        assert told(edited(("version = 2", f"version = {other}"))) == [("mirror.version", unknown)]


@pytest.mark.promise("mirror-file-1")
def test_a_mirror_of_one_axis_is_none_of_several():
    faults = refusal(ONE_AXIS)
    assert [fault.key for fault in faults] == ["mirror.version"]
    assert "travel is a key of version 1: the file holds a mirror of one axis" in faults[0].reason
    assert "load_mirror reads this one" in faults[0].expected
    faults = refusal(edited(("version = 2\n", 'travel = "2 mrad"\n')))
    assert [(fault.key, fault.reason) for fault in faults] == [
        ("mirror.version", "is missing"),
        ("mirror.travel", "is a key of version 1, in a file of version 2"),
    ]


def test_a_number_whose_products_are_none_is_refused():
    """It overflowed where the mirror's growth was computed."""
    (fault,) = refusal(edited(("[-900.0, 0.0]", "[-900.0, -1e308]")))
    assert fault.key == "mirror.matrices.E" and "is beyond 1e+100" in fault.reason


def test_numbered_tables_are_in_the_order_of_their_numbers():
    tables = {str(number): f"table {number}" for number in (1, 10, 11, 2, 3, 9)}
    assert in_order(tables) == tuple(f"table {number}" for number in (1, 2, 3, 9, 10, 11))


MATRIX = coupled_parts._Matrix(Quantity(""))


def refused(call, *given):
    """The problems that a call raises."""
    with pytest.raises(ProblemsError) as error:
        call(*given)
    return error.value.problems


def named(*names):
    """Tables with these names, by number."""
    return {str(number): SimpleNamespace(name=name) for number, name in enumerate(names, 1)}


def placed(*places):
    """Displacements at these places, by number."""
    tables = [SimpleNamespace(name=f"s{place}", quantity="displacement", position_m=place) for place in places]
    return {str(number): table for number, table in enumerate(tables, 1)}


def plays(*weights, **more):
    """An element of plays, the first without a threshold."""
    return made(HysteresisTable, model="plays", thresholds_v=(0.0, 1.0, 2.0)[: len(weights)], weights=weights, **more)


def two_by_three(modes=None, hysteresis=None, **matrices):
    """A mirror of three drives and two outputs, of two states and as many elements as are given."""
    modes = modes or made(ModesTable, decay_1_s=(5.0,), frequency_rad_s=(40.0,))
    elements = {str(number): table for number, table in enumerate(hysteresis or (), 1)}
    outputs = {"1": SimpleNamespace(name="x", quantity="angle"), "2": SimpleNamespace(name="y", quantity="angle")}
    return made(
        CoupledMirror,
        actuators=named("a", "b", "c"),
        outputs=outputs,
        modes=modes,
        hysteresis=elements,
        matrices=made(MatricesTable, **matrices),
    )


ALL_OF_SEVERAL_AXES = {
    "rows that are none": (
        lambda: refused(MATRIX.read, [[1.0], 2.0]),
        """
        is no list of rows: expected a list of rows, each a list of numbers without quotes: [[1.0, 0.0], [0.0, 1.0]]
        """,
    ),
    "rows of which the second and third are wrong": (
        lambda: refused(MATRIX.read, [[1.0], [2.0, "3"], []]),
        """
        row 2: item 2: "3" is not a plain number; expected a number without quotes, for example "1.0": expected a
        list of rows, each a list of numbers without quotes; row 3: is not a list with something in it: expected a
        list of rows, each a list of numbers without quotes
        """,
    ),
    "an actuator of no range": (
        lambda: made(ActuatorTable, drive_min_v=12.5, drive_max_v=12.5, bias_v=1.0).problems(),
        """drive_max is not above drive_min (12.5 V): expected a voltage above 12.5 V""",
    ),
    "an actuator with a bias out of its range": (
        lambda: made(ActuatorTable, drive_min_v=-2.5, drive_max_v=12.5, bias_v=-3.0).problems(),
        """bias is outside drive_min to drive_max (-2.5 V to 12.5 V): expected -2.5 V to 12.5 V""",
    ),
    "an angle at a place of three numbers": (
        lambda: made(OutputTable, quantity="angle", position_m=(0.0, 0.1, 0.2)).problems(),
        """
        position stands with an angle, which is alike everywhere on a mirror: expected this line removed; position
        has 3 coordinates: expected x and y in the plane of the mirror: position = ["30 mm", "0 mm"]
        """,
    ),
    "a recording of no band, beyond half of its rate": (
        lambda: made(RecordingTable, excited_from_hz=1300.0, excited_to_hz=1275.0, rate_hz=2500.0).problems(),
        """
        excited_to is not above excited_from: expected a band that goes up; excited_to is above half the rate (1.25
        kHz): expected at most 1.25 kHz
        """,
    ),
    "a recording at a rate of many digits, beyond half of it": (
        lambda: made(RecordingTable, excited_from_hz=1.0, excited_to_hz=1300.0, rate_hz=2501.4).problems(),
        """excited_to is above half the rate (1.25 kHz): expected at most 1.25 kHz""",
    ),
    "a bias out of a range of five digits": (
        lambda: made(ActuatorTable, drive_min_v=-2.5004, drive_max_v=99.996, bias_v=100.0).problems(),
        """bias is outside drive_min to drive_max (-2.5004 V to 99.996 V): expected -2.5004 V to 99.996 V""",
    ),
    "modes that grow, and too few frequencies": (
        lambda: made(ModesTable, decay_1_s=(5.0, 0.0, -2.5), frequency_rad_s=(40.0, 0.0)).problems(),
        """
        decay item 2 is 0 1/s: an unstable mode, which does not die out: expected above 0 1/s; decay item 3 is -2.5
        1/s: an unstable mode, which does not die out: expected above 0 1/s; frequency has 2 items where decay has
        3: expected one for each mode, "0 rad/s" for a real one
        """,
    ),
    "plays with what a loop has": (
        lambda: made(
            HysteresisTable,
            model="plays",
            thresholds_v=(0.0, 1.0),
            weights=(0.0, 0.0, 0.0),
            widening_s=1e-6,
            alpha_1_v=1.0,
            bias_v=0.0,
            polynomial=(0.0, 0.0),
        ).problems(),
        """
        alpha does not belong to model = "plays": expected this line removed, or model = "bouc-wen"; bias does not
        belong to model = "plays": expected this line removed, or model = "bouc-wen"; rate_limit is missing, and the
        element depends on the rate: expected rate_limit = "1 kV/s"; weights has 3 items where thresholds has 2:
        expected one weight for each threshold; weights is zero throughout, so the element acts on nothing: expected
        a weight other than 0, or a polynomial beside them; polynomial has 2 items: expected three: of s^2, of |s| s
        and of s^3, such as [0.0, 0.01, -0.02]; reach is missing beside polynomial: expected reach = "2 V"
        """,
    ),
    "plays with a reach and without weights": (
        lambda: made(HysteresisTable, model="plays", thresholds_v=(0.0, 1.0), reach_v=2.0).problems(),
        """weights is missing, and model = "plays" needs it: expected weights = [0.8, 0.1] would do""",
    ),
    "plays with a reach and without a polynomial": (
        lambda: made(
            HysteresisTable, model="plays", thresholds_v=(0.0, 1.0), weights=(0.5, 0.25), reach_v=2.0
        ).problems(),
        """polynomial is missing beside reach: expected polynomial = [0.0, 0.01, -0.02]""",
    ),
    "a loop with what plays have, that grows": (
        lambda: made(
            HysteresisTable,
            model="bouc-wen",
            d1=0.0,
            epsilon=0.0,
            alpha_1_v=1.0,
            beta_1_v=0.75,
            gamma_1_v=0.5,
            eta_1_v=-0.25,
            d2_s_v=0.1,
            reach_v=1.0,
        ).problems(),
        """
        reach does not belong to model = "bouc-wen": expected this line removed, or model = "plays"; rate_limit is
        missing, and the element depends on the rate: expected rate_limit = "1 kV/s"; alpha is not above what beta,
        gamma and eta take off it (1.5 1/V), so h would grow without bound: expected above 1.5 1/V; d1 is 0 beside
        an epsilon of 0, so the element acts on nothing: expected one of them other than 0
        """,
    ),
    "a loop with nothing but its rate": (
        lambda: made(HysteresisTable, model="bouc-wen", delta_s_v=0.25).problems(),
        """
        d1 is missing, and model = "bouc-wen" needs it: expected d1 = 0.8 would do; epsilon is missing, and model =
        "bouc-wen" needs it: expected epsilon = -0.2 would do; alpha is missing, and model = "bouc-wen" needs it:
        expected alpha = "2 1/V" would do; beta is missing, and model = "bouc-wen" needs it: expected beta = "0.5
        1/V" would do; rate_limit is missing, and the element depends on the rate: expected rate_limit = "1 kV/s"
        """,
    ),
    "rows of other lengths": (
        lambda: shape_problems("B", ((1.0, 2.0), (1.0,), (1.0, 2.0, 3.0), (1.0,)), (3, "states"), (2, "actuators")),
        """
        B has 4 rows where there are 3 states: expected one row for each, in order; B row 2 has 1 numbers where
        there are 2 actuators; 2 other rows do not fit, either: expected 2 numbers in each row
        """,
    ),
    "a factor beside a correlation that counts otherwise": (
        lambda: made(
            UncertaintyTable,
            parameters=("a", "b", "c"),
            standard_errors=(0.1,),
            factor=((1.0, 0.0), (0.75, 0.75), (0.5, 0.5)),
            correlation=(0.5, 0.25),
        ).problems(),
        """
        standard_errors has 1 item where parameters has 3: expected one standard error for each parameter;
        correlation stands beside factor: expected one of the two removed; factor row 2 has the length 1.06066, so
        the correlation with itself is not 1; 2 of 3 rows have another length than 1: expected rows of length 1;
        correlation has 2 items where 3 parameters have 3 pairs: expected 3 numbers, the lower triangle without the
        diagonal, or none
        """,
    ),
    "correlations that cannot be": (
        lambda: made(
            UncertaintyTable,
            parameters=("a", "b", "c"),
            standard_errors=(0.1, 0.2, 0.3),
            correlation=(0.875, 0.75, -0.5),
        ).problems(),
        """
        correlation is not positive semidefinite: its smallest eigenvalue is -0.428: expected correlations that can
        be together, as the fit gave them
        """,
    ),
    "tables that are not there, and displacements on a line": (
        lambda: made(
            CoupledMirror, actuators={}, outputs=placed((0.0, 0.0), (0.25, 0.5), (0.5, 1.0)), hysteresis={}
        ).problems(),
        """
        actuators is empty: expected a table [actuators.1]; outputs has all displacements on one line, so a tilt
        about that line moves none: expected three displacements with a position, not on one line, or no position
        """,
    ),
    "tables that are counted otherwise, of one name": (
        lambda: made(
            CoupledMirror,
            actuators={
                "1": SimpleNamespace(name="a"),
                "3": SimpleNamespace(name="b"),
                "2b": SimpleNamespace(name="a"),
                "4": SimpleNamespace(name="a"),
            },
            outputs=placed((0.0, 0.0), None, (0.5, 1.0), None),
            hysteresis={"0": 0},
        ).problems(),
        """
        actuators has "2b" where its 4 tables are counted from 1: expected [actuators.1], [actuators.2],
        [actuators.3]; actuators has two tables of the name "a": expected a name of its own for each; outputs has
        two tables of the name "sNone": expected a name of its own for each; hysteresis has "0" where its 1 tables
        are counted from 1: expected [hysteresis.1]; outputs.2.position is missing, while other displacements have
        one: expected a position of each displacement, or of none; outputs.4.position is missing, while other
        displacements have one: expected a position of each displacement, or of none
        """,
    ),
    "displacements of which two have places": (
        lambda: coupled_mirror._place_problems(placed((0.0, 0.0), (0.5, 1.0))),
        """
        outputs has 2 displacements with a position, too few for two tilts and a piston: expected three
        displacements with a position, not on one line, or no position
        """,
    ),
    "matrices of other shapes, without elements and outputs of the states": (
        lambda: two_by_three(
            B=((1.0, 2.0), (3.0, 4.0)), D=((1.0, 2.0, 3.0),), E=((1.0,),), G=((1.0, 2.0, 3.0),)
        ).problems(),
        """
        matrices.B row 1 has 2 numbers where there are 3 actuators; 1 other rows do not fit, either: expected 3
        numbers in each row; matrices.D has 1 rows where there are 2 outputs: expected one row for each, in order;
        matrices.E stands without a table [hysteresis.1]: expected it, or this line removed; matrices.G stands
        without a table [hysteresis.1]: expected it, or this line removed; matrices has no C, so none of the 2
        states is seen in an output: expected C, with a row for each output, or the table [modes] removed
        """,
    ),
    "an element that acts on nothing, and one that nothing drives": (
        lambda: two_by_three(
            hysteresis=(plays(0.25), plays(0.5)),
            C=((1.0, 0.0), (0.0, 1.0)),
            E=((0.0, 1.0), (0.0, 2.0)),
            F=((1.0, 0.0), (0.0, 0.0)),
            G=((0.0, 0.0, 0.0), (0.0, 0.0, 0.0)),
        ).problems(),
        """
        hysteresis.1 acts on nothing: column 1 of E and of K is zero: expected a number other than 0 there, or this
        element removed from all matrices; hysteresis.2 is driven by nothing: row 2 of F and of G is zero: expected
        a number other than 0 there, or this element removed from all matrices
        """,
    ),
    "elements that are fed back and depend on the rate": (
        lambda: two_by_three(
            hysteresis=(plays(0.25, widening_s=2e-6), made(HysteresisTable, model="bouc-wen", delta_s_v=0.125)),
            C=((1.0, 0.0), (0.0, 1.0)),
            F=((0.0, 1.0), (1.0, 0.0)),
            K=((1.0, 0.0), (0.0, 1.0)),
        ).problems(),
        """
        hysteresis.1.widening makes an element depend on the rate that row 1 of F feeds back: expected this line
        removed, or a row of zeros in F; hysteresis.2.delta makes an element depend on the rate that row 2 of F
        feeds back: expected this line removed, or a row of zeros in F
        """,
    ),
    "a loop without end in its stiffness": (
        lambda: two_by_three(
            modes=made(ModesTable, decay_1_s=(5.0, 3.0), frequency_rad_s=(0.0, 0.0)),
            hysteresis=(made(HysteresisTable, model="bouc-wen", d1=1.25), plays(0.5, 0.25)),
            C=((1.0, 0.0), (0.0, 1.0)),
            E=((2.0, 0.5), (0.0, 1.0)),
            F=((3.0, 0.25), (0.0, 1.0)),
        ).problems(),
        """
        hysteresis makes the mirror run away: where its elements slide it grows by 2.5 1/s, whatever the drive:
        expected smaller weights, or smaller numbers in E or F
        """,
    ),
    "elements whose stiffness runs away": (
        lambda: two_by_three(
            modes=made(ModesTable, decay_1_s=(5.0, 3.0), frequency_rad_s=(0.0, 0.0)),
            hysteresis=(plays(1.5, 2.25), plays(0.5, 0.25)),
            C=((1.0, 0.0), (0.0, 1.0)),
            E=((2.0, 0.5), (0.0, 1.0)),
            F=((3.0, 0.25), (0.0, 1.0)),
        ).problems(),
        """
        hysteresis makes the mirror run away: where its elements slide it grows by 17.5 1/s, whatever the drive:
        expected smaller weights, or smaller numbers in E or F
        """,
    ),
}


@pytest.mark.parametrize("what", ALL_OF_SEVERAL_AXES)
def test_all_that_does_not_fit_in_a_mirror_of_several_axes_is_told_in_full(what):
    problems, words = ALL_OF_SEVERAL_AXES[what]
    assert told(problems()) == one_line(words)


def test_a_mirror_has_a_number_for_each_parameter_by_its_key():
    modes = made(ModesTable, decay_1_s=(5.0, 3.0), frequency_rad_s=(40.0, 0.0))
    loop = made(HysteresisTable, model="bouc-wen", d1=0.5, epsilon=-0.25, alpha_1_v=2.0, beta_1_v=0.75, exponent=1.5)
    mirror = two_by_three(
        modes,
        (plays(0.25, 0.125, widening_s=2e-6, polynomial=(0.1, 0.2, 0.3)), loop),
        D=((1.0, 2.0, 3.0), (4.0, 5.0, 6.0)),
    ).model_copy(update={"recording": made(RecordingTable, delay_s=1e-4)})
    assert parameters(mirror) == {
        "recording.delay": 1e-4,
        "modes.decay.1": 5.0,
        "modes.decay.2": 3.0,
        "modes.frequency.1": 40.0,
        **{f"matrices.D.{i}.{j}": 3.0 * i + j - 3.0 for i in (1, 2) for j in (1, 2, 3)},
        "hysteresis.1.thresholds.1": 0.0,
        "hysteresis.1.thresholds.2": 1.0,
        "hysteresis.1.weights.1": 0.25,
        "hysteresis.1.weights.2": 0.125,
        "hysteresis.1.widening": 2e-6,
        "hysteresis.1.polynomial.1": 0.1,
        "hysteresis.1.polynomial.2": 0.2,
        "hysteresis.1.polynomial.3": 0.3,
        "hysteresis.2.d1": 0.5,
        "hysteresis.2.epsilon": -0.25,
        "hysteresis.2.alpha": 2.0,
        "hysteresis.2.beta": 0.75,
        "hysteresis.2.exponent": 1.5,
    }
    assert (mirror.states, modes.states, modes.roots) == (3, 3, ((-5.0, 40.0), (-3.0, 0.0)))
    sides = {name: mirror.shape_of(name) for name in "BCDEFGK"}
    states, drives, outputs, elements = (3, "states"), (3, "actuators"), (2, "outputs"), (2, "elements")
    assert sides == {
        "B": (states, drives), "C": (outputs, states), "D": (outputs, drives), "E": (states, elements),
        "F": (elements, states), "G": (elements, drives), "K": (outputs, elements),
    }  # fmt: skip


def test_parameters_that_are_none_or_stand_twice_are_told_with_the_nearest():
    mirror = two_by_three().model_copy(update={"recording": made(RecordingTable, delay_s=1e-4)})
    uncertainty = SimpleNamespace(parameters=("modes.decay.1", "modes.decy.1", "zzz", "modes.decay.1", "zzz"))
    none = 'which is no parameter of this mirror: expected such as "modes.decay.1"'
    twice = "more than once: expected each parameter once"
    assert told(coupled_mirror._name_problems(mirror, uncertainty)) == "; ".join(
        f"uncertainty.parameters has {each}"
        for each in (
            f'"modes.decy.1", {none}',
            f'"zzz", {none}',
            f'"zzz", {none}',
            f'"modes.decay.1" {twice}',
            f'"zzz" {twice}',
        )
    )


def test_the_correlation_of_several_axes_is_whole_from_its_lower_triangle():
    table = made(UncertaintyTable, parameters=("a", "b", "c"), correlation=(0.1, 0.2, 0.3))
    assert table.correlation_matrix.tolist() == [[1.0, 0.1, 0.2], [0.1, 1.0, 0.3], [0.2, 0.3, 1.0]]
    assert made(UncertaintyTable, parameters=("a", "b")).correlation_matrix.tolist() == [[1.0, 0.0], [0.0, 1.0]]


@pytest.mark.parametrize(("items", "told"), [(0, False), (1, True), (2, True), (3, False), (4, True), (6, True)])
def test_correlations_of_three_parameters_are_three_or_none(items, told):
    table = mirror_table.Uncertainty.model_construct(
        parameters=("gain", "bouc_wen.d1", "linear.poles.1"),
        standard_errors=(0.1, 0.2, 0.3),
        correlation=(0.25,) * items,
    )
    found = [(each.key, each.reason, each.expected) for each in table.problems()]
    wanted = ("correlation", f"has {items} item{'s' * (items != 1)} where 3 parameters have 3 pairs")
    assert found == ([(*wanted, "3 numbers, the lower triangle without the diagonal, or none")] if told else [])


# ------------------------------------------------------------------------------------------ the mirror of a loop
DEFAULT_TEXT = MISSION.read_text(encoding="utf-8")
IN_THE_LOOP = DEFAULT_TEXT.replace("\n[fine_pointing]\n", '\n[fine_pointing]\nmirror_file = "lab/two-axes.toml"\n', 1)


@pytest.mark.parametrize(("version", "held"), [
    ("2", True), ("3", False), ("1", False), ("2.0", False), ('"2"', False), ("[2]", False), ("true", False),
    (None, False),
])  # fmt: skip
def test_a_mirror_file_says_by_a_whole_number_that_it_has_several_axes(tmp_path, version, held):
    given = "" if version is None else f"version = {version}\n"
    (tmp_path / "mirror.toml").write_text(f"{given}unknown = 5\n", encoding="utf-8")
    assert holds_several_axes(tmp_path / "mirror.toml") is held


@pytest.fixture
def laboratory(tmp_path):
    """A folder with a mission whose loop names a mirror, and with mirrors of one and of two axes."""
    (tmp_path / "lab").mkdir()
    (tmp_path / "lab" / "two-axes.toml").write_text(TEXT, encoding="utf-8")
    (tmp_path / "mission.toml").write_text(IN_THE_LOOP, encoding="utf-8")
    (tmp_path / "one.toml").write_text(ONE_AXIS.replace('name = "', 'name = "our ', 1), encoding="utf-8")
    (tmp_path / "two.toml").write_text(edited(('name = "', 'name = "our ')), encoding="utf-8")
    return tmp_path


def test_a_loop_has_the_mirror_of_its_file_beside_a_given_one_of_one_axis(laboratory):
    file, mirror = load_loop(laboratory / "mission.toml", str(laboratory / "one.toml"))
    assert file.mirror_file.path == laboratory / "one.toml"
    assert file.mission.mirror.name.startswith("our ") and mirror == loaded(TEXT)


def test_a_given_mirror_of_several_axes_is_that_of_the_loop_and_leaves_the_mission_its_own(laboratory):
    file, mirror = load_loop(laboratory / "mission.toml", str(laboratory / "two.toml"))
    assert (file.mirror_file, mirror) == (None, load_coupled_mirror(laboratory / "two.toml"))
    assert not file.mission.mirror.name.startswith("our ") and mirror.name.startswith("our ")


def test_a_loop_without_a_file_for_it_and_a_mission_without_a_loop_have_no_such_mirror():
    for text in (DEFAULT_TEXT, without_fine_pointing(DEFAULT_TEXT)):
        file = load_mission(MISSION, text=text)
        assert mirror_of_loop(file) is None
    assert file.mission.fine_pointing is None


def test_the_mirror_of_a_loop_is_that_of_the_time_at_which_its_mission_was_read(laboratory):
    named = laboratory / "lab" / "two-axes.toml"
    named.write_bytes(b"\xef\xbb\xbf" + TEXT.replace("\n", "\r\n").encode())
    file = load_mission(laboratory / "mission.toml")
    read = with_contents(file)
    named.write_text(edited(('name = "', 'name = "another ')), encoding="utf-8")
    assert mirror_of_loop(read) == loaded(TEXT)
    assert mirror_of_loop(file).name.startswith("another ")
    named.write_bytes(TEXT.encode().replace(b"\n", b"  # \xff\n", 3).replace(b"  # \xff", b"", 2))
    read = with_contents(file)
    named.unlink()
    for of, reason in ((read, "is not UTF-8 text (line 3)"), (file, "does not exist")):
        fault = only_fault(lambda of=of: mirror_of_loop(of))
        assert (fault.file, fault.reason) == (str(named), f"the mirror file {reason}")


@pytest.mark.parametrize(("alpha", "taken"), [(1.125, False), (1.1251, True), (0.9, False)])
def test_the_decay_of_an_element_exceeds_what_its_own_gamma_and_eta_take_off_it(alpha, taken):
    """Of beta = 0.5, gamma = -0.125 and eta = 0.5 1/V the larger is |0.5 + 0.5| + 0.125."""
    keys = f'alpha = "{alpha} 1/V"\nbeta = "0.5 1/V"\ngamma = "-0.125 1/V"\neta = "0.5 1/V"\n'
    text = TEXT.replace(PLAYS, f'[hysteresis.2]\nmodel = "bouc-wen"\nd1 = 0.02\nepsilon = -0.01\n{keys}\n')
    assert text != TEXT
    text = text[: text.index("[uncertainty]")]
    if taken:
        assert in_order(loaded(text).hysteresis)[1].alpha_1_v == alpha
    else:
        (fault,) = refusal(text)
        assert (fault.key, fault.expected) == ("mirror.hysteresis.2.alpha", "above 1.125 1/V")


@pytest.mark.parametrize("version", ["1", "0", "-2", "3", "true", "[2]"])
def test_a_version_below_or_above_that_of_several_axes_is_none(tmp_path, version):
    path = tmp_path / "mirror.toml"
    path.write_text(edited(("version = 2", f"version = {version}")), encoding="utf-8")
    fault = only_fault(lambda: load_coupled_mirror(path))
    assert fault.key.endswith("version") and fault.reason == "is no version of a mirror of several axes"


@pytest.mark.parametrize(("place", "refused"), [((0.03,), True), ((0.1, 0.2), False), ((0.1, 0.2, 0.3), True)])
def test_a_place_on_a_mirror_has_two_coordinates_no_fewer_and_no_more(place, refused):
    found = list(made(OutputTable, quantity="displacement", position_m=place).problems())
    wanted = 'x and y in the plane of the mirror: position = ["30 mm", "0 mm"]'
    assert [(each.key, each.expected) for each in found] == [("position", wanted)] * refused
    assert all(each.reason.startswith(f"has {len(place)} coordinate") for each in found)


@pytest.mark.parametrize(("wrong", "rows", "told"), [(1, 19, 19), (1, 30, 20), (3, 6, 18), (3, 30, 21), (30, 30, 30)])
def test_of_a_matrix_twenty_faults_are_told_and_those_that_share_a_row_with_the_last(wrong, rows, told):
    problems = refused(MATRIX.read, [[1.0, *["a"] * wrong]] * rows)
    assert len(problems) == told
    assert problems[0].reason.startswith("row 1: item 2: ")
    assert problems[-1].reason.startswith(f"row {-(-told // wrong)}: item {wrong + 1}: ")
