"""What a step of exported code costs: the stated counts against the generated code itself, with counted operators."""

import ctypes
import re
import shutil
import subprocess
from dataclasses import dataclass, fields, replace
from pathlib import Path

import numpy as np
import pytest

import designs
from microrad.core import kernels, lti
from microrad.core.arrays import Floats
from microrad.export.flight import c_code, double_run, fixed, fixed_form, operations, rounding
from microrad.export.flight.fixed_form import FixedForm
from microrad.export.flight.operations import FixedOperations, Operations
from microrad.export.flight.rounding import RoundingBound
from microrad.export.linear_part.sections import sections
from microrad.export.records import FlightController, InverseLaw, Origin, Signal, Vectors
from waiting import HANG_S

KINDS = tuple(each.name for each in fields(Operations))
WHOLE_KINDS = ("multiplications", "additions", "shifts", "comparisons", "conversions")

needs_gxx = pytest.mark.skipif(shutil.which("g++") is None, reason="no g++ here to count the operators with")

NUMBER = """#include <float.h>
#include <math.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

enum kind {
    MULTIPLICATION, ADDITION, DIVISION, COMPARISON, EXPONENTIAL, LOGARITHM, POWER, ROUNDING,
    PRODUCT, SUM, SHIFT, ORDER, CONVERSION, KINDS
};
static long long tally[KINDS];

struct wide {
    int64_t value;
    wide() = default;
    wide(long long x) : value(x) {}
    explicit operator int32_t() const { return (int32_t)value; }
};

struct number {
    BASE value;
    number() = default;
    number(double x) : value((BASE)x) {}
    explicit number(int32_t x) : value((BASE)x) { tally[CONVERSION]++; }
    explicit operator wide() const { tally[CONVERSION]++; return (long long)value; }
};

#define OPERATOR(type, sign, kind) \\
    static inline type operator sign(type a, type b) { tally[kind]++; return a.value sign b.value; } \\
    static inline type &operator sign##=(type &a, type b) { return a = a sign b; }
#define COMPARE(sign) \\
    static inline bool operator sign(number a, number b) { tally[COMPARISON]++; return a.value sign b.value; } \\
    static inline bool operator sign(wide a, wide b) { tally[ORDER]++; return a.value sign b.value; }
#define FUNCTION(name, kind) static inline number name(number a) { tally[kind]++; return name(a.value); }
#define FREE(name) static inline number name(number a) { return name(a.value); }
#define OF_TWO(name, kind) \\
    static inline number name(number a, number b) { tally[kind]++; return name(a.value, b.value); }

OPERATOR(number, *, MULTIPLICATION)
OPERATOR(number, +, ADDITION)
OPERATOR(number, -, ADDITION)
OPERATOR(number, /, DIVISION)
OPERATOR(wide, *, PRODUCT)
OPERATOR(wide, +, SUM)
OPERATOR(wide, -, SUM)
OPERATOR(wide, <<, SHIFT)
OPERATOR(wide, >>, SHIFT)
COMPARE(<)
COMPARE(<=)
COMPARE(>)
COMPARE(>=)
COMPARE(==)
COMPARE(!=)
FUNCTION(EXP, EXPONENTIAL)
FUNCTION(EXPM1, EXPONENTIAL)
FUNCTION(LOG1P, LOGARITHM)
FUNCTION(FLOOR, ROUNDING)
FREE(FABS)
OF_TWO(POW, POWER)
OF_TWO(FMIN, COMPARISON)
OF_TWO(FMAX, COMPARISON)
static inline number operator-(number a) { return -a.value; }
static inline wide operator-(wide a) { return -a.value; }
static inline wide operator~(wide a) { return ~a.value; }
"""

REPLAY = """
extern "C" void replay(const double *reading, long samples, double *command_v, long long *counts)
{
    NAME_state state;
    NAME_init(&state);
    for (long k = 0; k < samples; k++, reading += READINGS, command_v += ACTUATORS, counts += KINDS) {
        TYPE in[READINGS], out[ACTUATORS];
        for (int i = 0; i < READINGS; i++) in[i] = reading[i];
        memset(tally, 0, sizeof tally);
        NAME_step(&state, SIGNALS, out);
        memcpy(counts, tally, sizeof tally);
        for (int a = 0; a < ACTUATORS; a++) command_v[a] = VALUE;
    }
}
"""


@dataclass(frozen=True)
class Counted:
    """Exported code in which each operator counts."""

    library: ctypes.CDLL
    actuators: int

    def replay(self, readings: Floats) -> tuple[Floats, np.ndarray]:
        """Commands (samples, actuators) and operations (samples, KINDS then WHOLE_KINDS) over a run from rest."""
        readings = np.ascontiguousarray(readings, dtype=float)
        samples, kinds = readings.shape[0], len(KINDS) + len(WHOLE_KINDS)
        commands, counts = np.zeros((samples, self.actuators)), np.zeros((samples, kinds), dtype=np.int64)
        arrays = [each.ctypes.data_as(ctypes.c_void_p) for each in (readings, commands, counts)]
        self.library.replay(arrays[0], ctypes.c_long(samples), *arrays[1:])
        return commands, counts

    def most(self, *runs: Floats) -> Operations:
        """Largest count of a step, by kind, over these runs."""
        return self.most_fixed(*runs).single

    def most_fixed(self, *runs: Floats) -> FixedOperations:
        """Likewise with the operations of whole numbers."""
        most = np.max([self.replay(each)[1].max(axis=0) for each in runs], axis=0).tolist()
        return FixedOperations(*most[len(KINDS) :], single=Operations(*most[: len(KINDS)]))


def compiled(folder: Path, files: dict[str, str], of: FlightController, precision: str, **values: str) -> Counted:
    """Code as C++ with classes that count for its numbers; ``values`` go into REPLAY."""
    for file, text in files.items():
        (folder / file).write_text(text)
    values |= {"READINGS": str(sum(each.size for each in of.inputs)), "ACTUATORS": str(of.actuators)}
    replay = re.sub("|".join(values), lambda found: values[found[0]], REPLAY)
    own = '#undef OUTPUT_OF_READINGS\n#define OUTPUT_OF_READINGS OUTPUT_OF_READINGS_{}\n#include "{}"\n'
    sources = "".join(own.format(*each) for each in enumerate(sorted(files)) if each[1].endswith(".c"))
    (folder / "all.cpp").write_text(NUMBER + sources + replay)
    base, suffix = ("float", "f") if precision == "single" else ("double", "")
    names = ("exp", "expm1", "log1p", "floor", "fabs", "pow", "fmin", "fmax")
    defined = [f"-D{each.upper()}={each}{suffix}" for each in names]
    command = ["g++", "-std=gnu++20", "-w", "-O0", "-shared", "-fPIC", f"-DBASE={base}", *defined]
    subprocess.run([*command, "-o", "code.so", "all.cpp"], cwd=folder, check=True, timeout=HANG_S)
    return Counted(ctypes.CDLL(str(folder / "code.so")), of.actuators)


def counted(folder: Path, of: FlightController, precision: str, trials: int | None = None) -> Counted:
    """The generated code with a class for its real numbers, at the most ``trials`` of its own."""
    bound = RoundingBound(1.0, 1, 0.0, "none")
    files = c_code.flight_code(of, sections(of), "code", precision, bound if precision == "single" else None)
    base, changed = "float" if precision == "single" else "double", {}
    for file in set(files) - {"Makefile", "code_bench.c"}:
        changed[file] = files[file].replace(f"typedef {base} code_real;", "typedef number code_real;")
        if trials is not None:
            changed[file] = re.sub(r"(#define CODE_MOST_TRIALS) \d+", rf"\1 {trials}", changed[file])
    places = np.cumsum([0, *(each.size for each in of.inputs)])
    signals = ", ".join(f"in + {at}" for at in places[:-1])
    return compiled(folder, changed, of, precision, NAME="code", TYPE="number", VALUE="out[a].value", SIGNALS=signals)


def counted_fixed(folder: Path, of: FlightController, made: FixedForm) -> Counted:
    """The generated code in fixed point with classes for its 64-bit numbers and for the inverse's real ones."""
    files, changed = fixed.fixed_code(of, sections(of), made, "code"), {}
    for file in set(files) - {"Makefile", "code_fixed_bench.c"}:
        text = re.sub(r"\bfloat\b(?!\.h)", "number", files[file])
        changed[file] = re.sub(r"\bint64_t\b|\bINT64_C\b", "wide", text)
    return compiled(folder, changed, of, "single", NAME="code_fixed", TYPE="int32_t", VALUE="out[a]", SIGNALS="in")


# ----------------------------------------------------------------------------------------------------------- designs
def designed(name: str) -> tuple[FlightController, Vectors]:
    """A controller of the mission, and a recorded run of it."""
    return designs.flown(name, 600)


def plain(of: InverseLaw | None, resolution_v: float = 1e-3) -> FlightController:
    """Two axes: an integrator, a slow and a quick state on the first; without an inverse reading to command, else the
    reading is the inverse's target, and the second reading its rate."""
    A = np.diag([1.0, 0.995, 0.5])
    B, L = np.array([[0.1, 0.0], [0.2, 0.0], [0.0, 0.3]]), np.array([[0.1, 0.0], [0.0, 0.0], [0.0, 0.2]])
    C, D = np.array([[1.0, 2.0, 0.0], [0.0, 0.0, 3.0]]), np.array([[1.0, 0.0], [0.5, 0.25]])
    inputs = (Signal("reading_rad", 2, "rad", "reading", 0.1),)
    if of is not None:
        rates = 0 if of.by_difference else 2
        B = np.hstack([B, np.zeros((3, 2 + rates))])
        D = np.hstack([D, np.zeros((2, 2 + rates))])
        D = np.vstack([D, np.hstack([np.zeros((2 + rates, 2)), np.eye(2 + rates)])])
        C = np.vstack([C, np.zeros((2 + rates, 3))])
        inputs += (Signal("target_rad", 2, "rad", "target", 0.1),)
        if rates:
            inputs += (Signal("rate_rad", 2, "rad", "rate (rad/s)", 100.0),)
    system = lti.StateSpace(A, B, C, D)
    return FlightController(
        "plain", Origin("none", "0" * 64, "none"), 1e-3, inputs, 2, system, L, of, -50.0, 50.0, resolution_v, 0.0, ()
    )


def law(*, epsilon: float = 2e-5, power: float = 0.0, plays: bool = True, by_difference: bool = True) -> InverseLaw:
    """An inverse with everything in it: three Bouc-Wen elements, plays that widen on one actuator, and creep."""
    row = [1e-4, 1e-6, epsilon, 1e-4, 30.0, 20.0, 2e3, 1.0, 3.0, 2.0, power, 30.0 / abs(epsilon)]
    play = np.array([0.0, 1e-4, 3e-4, 0.0, 2e-4]) if plays else np.zeros(0)
    return InverseLaw(
        direct=np.array([0.0, 100.0]),
        bouc_wen=np.array([row, row, row]),
        bouc_wen_actuator=np.array([0, 1, 1]),
        play_threshold=play,
        play_weight=np.full(play.size, 10.0),
        play_actuator=np.array([0, 0, 0, 1, 1])[: play.size],
        widening=np.array([[1e-4, 50.0], [0.0, np.inf]]) if plays else np.array([[0.0, np.inf]] * 2),
        lag_keep=np.array([0.9, 0.99]),
        lag_weight=np.array([1e-6, 2e-6]),
        lag_actuator=np.array([0, 1]),
        by_difference=by_difference,
    )


def swinging(of: FlightController) -> Floats:
    """Readings that swing alike, by sizes from 1 to 100 % of what is accepted: all elements cross zero together."""
    k = np.arange(3000)
    wave = np.sin(0.05 * k) * np.geomspace(1e-3, 0.99, k.size)
    return np.hstack([np.outer(wave, np.full(each.size, each.limit)) for each in of.inputs])


def wild(of: FlightController) -> Floats:
    """Readings of all sizes, signs and kinds."""
    rng = np.random.Generator(np.random.Philox(8))
    limits = np.concatenate([np.full(each.size, each.limit) for each in of.inputs])
    found = rng.standard_normal((4000, limits.size)) * limits * 10.0 ** rng.uniform(-12, 1, (4000, limits.size))
    odd = rng.random(found.shape)
    found[odd < 0.01] = np.nan
    found[(odd > 0.01) & (odd < 0.02)] = np.inf
    found[(odd > 0.02) & (odd < 0.03)] = -np.inf
    found[(odd > 0.03) & (odd < 0.1)] = 0.0
    found[1000:1500] = found[1000]
    return found


# ------------------------------------------------------------------------------------------------- against the code
@pytest.mark.promise("export-22")
@needs_gxx
@pytest.mark.parametrize(
    ("name", "precision"),
    [
        ("PI + inverse in series", "double"),
        pytest.param("PI + inverse in series", "single", marks=pytest.mark.endurance),
        pytest.param("PID + inverse", "double", marks=pytest.mark.endurance),
        ("resonant damping", "single"),
    ],
)
def test_a_designed_controller_costs_what_is_stated(tmp_path: Path, name: str, precision: str) -> None:
    of, run = designed(name)
    code, stated = counted(tmp_path, of, precision), operations.operations(of, sections(of), precision)
    assert code.most(run.inputs, swinging(of), wild(of)) == stated


NO_ELEMENTS = {"bouc_wen": np.zeros((0, 12)), "bouc_wen_actuator": np.zeros(0, dtype=int)}
NO_PLAYS = {key: np.zeros(0, dtype=int) for key in ("play_threshold", "play_weight", "play_actuator")}

PLAIN = {
    "no inverse": plain(None),
    "no converter": plain(None, resolution_v=0.0),
    "all": plain(law()),
    "rate given": plain(law(by_difference=False)),
    "no plays": plain(law(plays=False)),
    "widening of nothing": plain(replace(law(), **NO_ELEMENTS, **NO_PLAYS)),
    "no elements": plain(replace(law(), **NO_ELEMENTS)),
}
PLAIN_AGAIN = ("no converter", "rate given", "widening of nothing")
"""What differs from another one by a line or two of its code."""


@pytest.mark.promise("export-22")
@needs_gxx
@pytest.mark.parametrize(
    ("name", "precision"),
    [
        *((name, "single") for name in PLAIN if name not in PLAIN_AGAIN),
        *(pytest.param(name, "single", marks=pytest.mark.endurance) for name in PLAIN_AGAIN),
        pytest.param("no inverse", "double", marks=pytest.mark.endurance),
        pytest.param("all", "double", marks=pytest.mark.endurance),
    ],
)
def test_each_kind_of_inverse_costs_what_is_stated(tmp_path: Path, name: str, precision: str) -> None:
    of = PLAIN[name]
    code, stated = counted(tmp_path, of, precision), operations.operations(of, sections(of), precision)
    assert code.most(swinging(of), wild(of)) == stated


@needs_gxx
def test_a_worst_case_that_cannot_happen_is_not_exceeded(tmp_path: Path) -> None:
    """With epsilon < 0 elements cross zero from below where the plays fall: no step has both's comparisons."""
    of = plain(law(epsilon=-2e-5))
    stated = operations.operations(of, sections(of), "double")
    most = counted(tmp_path, of, "double").most(swinging(of), wild(of))
    assert replace(most, comparisons=0) == replace(stated, comparisons=0)
    assert stated.comparisons - 5 <= most.comparisons < stated.comparisons


@needs_gxx
@pytest.mark.parametrize(
    ("precision", "trials"), [pytest.param("double", 1, marks=pytest.mark.endurance), ("single", 3)]
)
def test_an_exponent_other_than_1_costs_its_trials(
    tmp_path: Path, precision: str, trials: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """On a long ramp h rests at its end: trial steps are accepted, and still too short to be enough."""
    of = plain(law(power=0.7, plays=False))
    monkeypatch.setattr(operations, "MOST_TRIALS", trials)
    stated = operations.operations(of, sections(of), precision)
    code, ramp = counted(tmp_path, of, precision, trials), np.outer(np.linspace(-0.09, 0.09, 1000), np.ones(4))
    assert code.most(ramp, swinging(of), wild(of)) == stated


def test_the_trials_are_those_of_the_code() -> None:
    of = plain(law(power=0.7, plays=False))
    header = c_code.flight_code(of, sections(of), "code", "double")["code_hysteresis.h"]
    assert re.findall(r"#define CODE_MOST_TRIALS (\d+)", header) == [str(operations.MOST_TRIALS)]
    powers = operations.operations(of, sections(of), "double").powers
    assert powers == 3 * 8 * operations.MOST_TRIALS  # three elements; seven slopes and the next length a trial


@needs_gxx
def test_what_counts_still_commands_the_same(tmp_path: Path) -> None:
    of, run = designed("PI + inverse in series")
    commands, counts = counted(tmp_path, of, "double").replay(run.inputs)
    assert np.abs(commands - run.commands).max() <= 1e-12 * np.abs(run.commands).max()
    assert counts.min(axis=0)[:3].min() > 0


# ------------------------------------------------------------------------------------------------------- fixed point
def run_of(of: FlightController) -> Vectors:
    """A small swinging run, which sets the scales of fixed point."""
    inputs = 0.2 * swinging(of)[:1500:5]
    nothing = np.zeros((inputs.shape[0], of.actuators))
    return Vectors(inputs, nothing, 0, 0)


def whole(made: FixedForm, readings: Floats) -> Floats:
    """Readings in the units of fixed point, at the end of 32 bits where they are beyond; 0 for what is no number."""
    scaled = np.rint(np.nan_to_num(readings, posinf=1e9, neginf=-1e9) * np.exp2(made.input_scale))
    return np.clip(scaled, -(2.0**31), 2.0**31 - 1.0)


FIXED = {
    "PI + inverse in series": 32,
    "resonant damping": 24,
    "no inverse": 32,
    "no converter": 24,
    "all": 32,
    "rate given": 24,
}
FIXED_AGAIN = {"PI + inverse in series", "no inverse", "no converter", "rate given"}
"""What differs from another one by its numbers, by a converter, or by a rate that is read and not computed."""


@pytest.mark.promise("export-22")
@needs_gxx
@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[pytest.mark.endurance] if name in FIXED_AGAIN else []) for name in FIXED]
)
def test_fixed_point_costs_what_is_stated(tmp_path: Path, name: str) -> None:
    of, run = (PLAIN[name], run_of(PLAIN[name])) if name in PLAIN else designed(name)
    made = fixed.quantised(of, sections(of), run, FIXED[name], beyond_a_count=True)
    runs = [whole(made, each) for each in (run.inputs, swinging(of), wild(of))]
    stated = operations.fixed_operations(of, made)
    assert counted_fixed(tmp_path, of, made).most_fixed(*runs) == stated
    assert (stated.single == Operations()) == (of.inverse is None)


@needs_gxx
def test_what_counts_in_fixed_point_still_commands_the_same(tmp_path: Path) -> None:
    of, run = designed("PI + inverse in series")
    made = fixed.quantised(of, sections(of), run)
    counts, _ = counted_fixed(tmp_path, of, made).replay(whole(made, run.inputs))
    assert np.abs(run.commands).max() > 0.0
    assert np.abs(counts * of.resolution_v - run.commands).max() <= made.report.bound_v


def test_fixed_point_is_said_in_words() -> None:
    a = FixedOperations(5, 1, 0, 2)
    assert a.words == "5 multiplications, 1 addition, 2 comparisons of whole numbers"
    b = replace(a, conversions=2, single=Operations(exponentials=1))
    assert b.words == f"{a.words}; 2 conversions; in single precision 1 exponential"


# ------------------------------------------------------------------------------------------------------- the records
def test_a_controller_without_states_costs_nothing_for_them() -> None:
    of = plain(None)
    none = np.zeros((0, 2))
    of = replace(
        of, system=lti.StateSpace(np.zeros((0, 0)), none, none.T, of.system.D), anti_windup=none, resolution_v=0.0
    )
    form = sections(of)
    found = operations.operations(of, form, "double")
    assert found.multiplications == np.count_nonzero(of.system.D)
    assert found.additions == np.count_nonzero(of.system.D) + of.actuators  # what the limits took off


@pytest.mark.promise("export-22")
def test_counts_add_up_and_are_said_in_words() -> None:
    a, b = Operations(multiplications=2, divisions=1), Operations(multiplications=1, powers=3)
    assert a + b == Operations(multiplications=3, divisions=1, powers=3)
    assert a * 4 == Operations(multiplications=8, divisions=4)
    assert a | b == Operations(multiplications=2, divisions=1, powers=3)
    assert (a + b).words == "3 multiplications, 1 division, 3 powers"
    assert Operations().words == "no operations"


# ------------------------------------------------------------------------------------------ sizes unlike each other
def unlike_law(*, power: float = 0.0, by_difference: bool = True) -> InverseLaw:
    """Two elements, three plays and one lag, not evenly over two actuators; no number of a kind is that of another."""
    row = [1e-4, 1e-6, 2e-5, 1e-4, 30.0, 20.0, 2e3, 1.0, 3.0, 2.0, 0.0, 30.0 / 2e-5]
    other = [-2e-4, 3e-6, -1e-5, 2e-4, 10.0, 5.0, 1e3, 2.0, 1.0, 0.5, power, 10.0 / 1e-5]
    return InverseLaw(
        direct=np.array([50.0, -100.0]),
        bouc_wen=np.array([row, other]),
        bouc_wen_actuator=np.array([1, 0]),
        play_threshold=np.array([0.0, 1e-4, 3e-4]),
        play_weight=np.array([10.0, -4.0, 7.0]),
        play_actuator=np.array([0, 1, 1]),
        widening=np.array([[0.0, np.inf], [1e-4, 50.0]]),
        lag_keep=np.array([0.9]),
        lag_weight=np.array([1e-6]),
        lag_actuator=np.array([1]),
        by_difference=by_difference,
    )


def unlike_bank(*, widening: float = 1e-4, power: float = 0.0, reach: float = 4.0) -> kernels.ForwardBank:
    """One Bouc-Wen element and two operators that drive two actuators, of one and of two plays."""
    bouc_wen = [0.2, -1e-5, -0.25, 2e-5, 0.1, -0.025, 1500.0, 6.0, 0.02, -0.01, power, 0.4]
    operator = [[widening, 40.0, 0.3, 0.2, -0.1, reach], [0.0, np.inf, 0.0, 0.0, 0.0, np.inf]]
    return kernels.ForwardBank(
        drives=np.array([[1.0, 0.5, 0.0], [0.0, -0.25, 2.0]]),
        bouc_wen=np.array([bouc_wen]),
        operator=np.array(operator),
        play_threshold=np.array([0.0, 0.5, 1.5]),
        play_weight=np.array([0.25, 0.5, -0.125]),
        play_start=np.array([0, 1, 3]),
        step_s=1e-3,
    )


def fed(bank: kernels.ForwardBank, of: InverseLaw | None = None) -> FlightController:
    """The plain controller with a feedforward of three elements, of which each is driven by another mixture."""
    made = plain(of)
    s, mixing = made.system, np.array([[1.0, 0.0], [0.0, 2.0], [3.0, -1.0]])
    C = np.vstack([s.C, 0.5 * mixing @ s.C[:2]])
    D = np.vstack([s.D, 40.0 * mixing @ s.D[:2]])
    return replace(made, system=lti.StateSpace(s.A, s.B, C, D), forward=bank)


UNLIKE = {
    "an inverse": lambda: plain(unlike_law()),
    "an inverse with a given rate": lambda: plain(unlike_law(by_difference=False)),
    "an inverse with an exponent": lambda: plain(unlike_law(power=0.5)),
    "a feedforward": lambda: fed(unlike_bank()),
    "a feedforward that neither widens nor bends": lambda: fed(unlike_bank(widening=0.0, reach=np.inf)),
    "a feedforward with an exponent": lambda: fed(unlike_bank(power=1.0)),
    "both": lambda: fed(unlike_bank(), unlike_law()),
    "neither": lambda: plain(None),
    "neither, without a converter": lambda: plain(None, 0.0),
}


def test_each_part_of_a_controller_costs_its_own_operations() -> None:
    found = {
        f"{name}, {precision}": operations.operations(make(), sections(make()), precision).words
        for name, make in UNLIKE.items()
        for precision in ("double", "single")
    }
    assert found == {
        "an inverse, double": (
            "65 multiplications, 70 additions, 18 divisions, 112 comparisons, 8 exponentials, 2 logarithms, 2 roundings"
        ),
        "an inverse, single": (
            "64 multiplications, 80 additions, 18 divisions, 120 comparisons, 8 exponentials, 2 logarithms, 2 roundings"
        ),
        "an inverse with a given rate, double": (
            "67 multiplications, 70 additions, 16 divisions, 120 comparisons, 8 exponentials, 2 logarithms, 2 roundings"
        ),
        "an inverse with a given rate, single": (
            "66 multiplications, 80 additions, 16 divisions, 128 comparisons, 8 exponentials, 2 logarithms, 2 roundings"
        ),
        "an inverse with an exponent, double": (
            "14139 multiplications, 9027 additions, 1039 divisions, 3178 comparisons, 6 "
            "exponentials, 1 logarithm, 2048 powers, 2 roundings"
        ),
        "an inverse with an exponent, single": (
            "14138 multiplications, 9037 additions, 1039 divisions, 3186 comparisons, 6 "
            "exponentials, 1 logarithm, 2048 powers, 2 roundings"
        ),
        "a feedforward, double": (
            "66 multiplications, 67 additions, 11 divisions, 96 comparisons, 4 exponentials, 1 logarithm, 2 roundings"
        ),
        "a feedforward, single": (
            "65 multiplications, 74 additions, 11 divisions, 102 comparisons, 4 exponentials, 1 logarithm, 2 roundings"
        ),
        "a feedforward that neither widens nor bends, double": (
            "54 multiplications, 57 additions, 7 divisions, 81 comparisons, 4 exponentials, 1 logarithm, 2 roundings"
        ),
        "a feedforward that neither widens nor bends, single": (
            "53 multiplications, 64 additions, 7 divisions, 87 comparisons, 4 exponentials, 1 logarithm, 2 roundings"
        ),
        "a feedforward with an exponent, double": (
            "14140 multiplications, 9024 additions, 1032 divisions, 3162 comparisons, 2 "
            "exponentials, 2048 powers, 2 roundings"
        ),
        "a feedforward with an exponent, single": (
            "14139 multiplications, 9031 additions, 1032 divisions, 3168 comparisons, 2 "
            "exponentials, 2048 powers, 2 roundings"
        ),
        "both, double": (
            "115 multiplications, 119 additions, 27 divisions, 170 comparisons, 12 "
            "exponentials, 3 logarithms, 2 roundings"
        ),
        "both, single": (
            "114 multiplications, 129 additions, 27 divisions, 178 comparisons, 12 "
            "exponentials, 3 logarithms, 2 roundings"
        ),
        "neither, double": "16 multiplications, 18 additions, 2 divisions, 38 comparisons, 2 roundings",
        "neither, single": "15 multiplications, 25 additions, 2 divisions, 44 comparisons, 2 roundings",
        "neither, without a converter, double": "14 multiplications, 16 additions, 34 comparisons",
        "neither, without a converter, single": "13 multiplications, 23 additions, 40 comparisons",
    }


def test_each_part_beside_fixed_point_costs_its_own_operations() -> None:
    found = {}
    for name in ("an inverse with a given rate", "a feedforward", "neither, without a converter"):
        of = UNLIKE[name]()
        made = fixed.quantised(of, sections(of), run_of(of), 24, beyond_a_count=True)
        found[name] = operations.fixed_operations(of, made).words
    assert found == {
        "an inverse with a given rate": (
            "19 multiplications, 38 additions, 37 shifts, 95 comparisons of whole numbers; 6 "
            "conversions; in single precision 57 multiplications, 59 additions, 14 divisions, "
            "102 comparisons, 8 exponentials, 2 logarithms, 2 roundings"
        ),
        "a feedforward": (
            "26 multiplications, 44 additions, 35 shifts, 79 comparisons of whole numbers; 5 "
            "conversions; in single precision 47 multiplications, 45 additions, 9 divisions, "
            "88 comparisons, 4 exponentials, 1 logarithm, 2 roundings"
        ),
        "neither, without a converter": "13 multiplications, 26 additions, 25 shifts, 61 comparisons of whole numbers",
    }


@pytest.mark.parametrize("name", [name for name in UNLIKE if name not in ("both", "neither, without a converter")])
def test_what_the_templates_get_has_each_number_of_its_own_part(name: str) -> None:
    of = UNLIKE[name]()
    found = c_code._values(of, sections(of), "unlike", "single")
    assert (found["elements"], found["plays"], found["lags"]) == ((2, 3, 1) if "inverse" in name else (0, 0, 0))
    forward = (3, 1, 2, 3) if "feedforward" in name else (0, 0, 0, 0)
    assert tuple(found[f"forward_{key}"] for key in ("count", "elements", "operators", "plays")) == forward
    if "feedforward" in name:
        plain_bank = "neither" in name
        assert (found["forward_widens"], found["forward_bends"]) == (not plain_bank, not plain_bank)
        assert found["forward_reach"].tolist() == [1.0 if plain_bank else 4.0, 1.0]
        assert found["forward_polynomial"].tolist() == [[0.3, 0.2, -0.1], [0.0, 0.0, 0.0]]
        assert found["rows"] == "v (V) 0 to 1, drive of each element 2 to 4"
    elif "inverse" in name:
        rate = ", rate of the target (rad/s) 4 to 5" if "given" in name else ""
        assert found["rows"] == f"v (V) 0 to 1, target (rad) 2 to 3{rate}"
        assert found["widening"] and found["uses_rate"] and found["direct"]
    assert found["bound_share"] == (c_code.POWER_BOUND_SHARE if "exponent" in name else c_code.BOUND_SHARE)
    assert (found["readings"], found["outputs"]) == (sum(s.size for s in of.inputs), len(of.system.C))
    assert found["all_compensated"] is False and sum(found["compensated"]) == 2


@pytest.mark.parametrize("name", ["an inverse", "a feedforward", "both", "an inverse with an exponent"])
def test_a_run_in_double_of_unlike_parts_is_clipped_where_limits_are(name: str) -> None:
    of = replace(UNLIKE[name](), minimum_v=-0.004, maximum_v=0.003)
    inputs = 0.3 * swinging(of)[1500:1900] * np.linspace(0.5, 1.5, swinging(of).shape[1])
    run = double_run.run_in_double(of, sections(of), inputs)
    command = np.clip(run.free, -0.004, 0.003)
    np.testing.assert_allclose(run.excess, command - run.free, rtol=0, atol=1e-15)
    assert np.any(run.excess > 0.0) and np.any(run.excess < 0.0)
    form = sections(of)
    moved = run.states[:-1] @ form.A.T + inputs[:-1] @ form.B.T + run.excess[:-1] @ form.L.T
    np.testing.assert_allclose(run.states[1:], moved, rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(run.outputs, run.states @ form.C.T + inputs @ form.D.T, rtol=1e-12, atol=1e-12)
    if run.forward is not None:
        np.testing.assert_allclose(run.forward.q, run.outputs[:, -3:], rtol=1e-12)
    if run.inverse is not None:
        creep = run.inverse.lag * of.inverse.lag_weight  # of the second actuator
        target = run.inverse.target + np.hstack([np.zeros_like(creep), creep])
        np.testing.assert_allclose(target, run.outputs[:, 2:4], rtol=1e-12, atol=1e-15)
        rate = np.diff(run.inverse.target, axis=0, prepend=0.0) / of.period_s
        np.testing.assert_allclose(run.inverse.rate, rate, rtol=1e-9, atol=1e-12)
    added = run.free - run.outputs[:, :2]
    wanted = 0.0 if run.inverse is None else run.inverse.added
    wanted = wanted + (0.0 if run.forward is None else run.forward.z @ of.forward.drives.T)
    np.testing.assert_allclose(added, wanted, rtol=1e-9, atol=1e-12)


def by_hand(bank: kernels.ForwardBank, q: Floats) -> Floats:
    """What the two operators of `unlike_bank` put out, written out for each of them."""
    quadratic, signed, cubic, reach = bank.operator[0].tolist()[2:]
    plays, found = np.zeros(3), np.zeros((len(q), 2))
    for k, (one, two) in enumerate(q.tolist()):
        plays[0] = one  # of no threshold, which no rate widens
        plays[1] = max(two - 0.5, min(two + 0.5, plays[1]))
        plays[2] = max(two - 1.5, min(two + 1.5, plays[2]))
        s = max(-1.0, min(1.0, one / reach))
        bent = quadratic * s * s + signed * s * abs(s) + cubic * s**3
        found[k] = 0.25 * plays[0] + bent, 0.5 * plays[1] - 0.125 * plays[2]
    return found


def test_operators_of_a_feedforward_have_each_their_own_plays_and_polynomial() -> None:
    bank = unlike_bank()
    k = np.arange(300.0)
    q = np.stack([np.zeros(300), 5.0 * np.sin(0.07 * k), 3.0 * np.sin(0.05 * k) + np.cos(0.3 * k)], axis=1)
    forward = double_run.Forward(bank, len(q))
    added = np.array([forward.step(row) for row in q])
    np.testing.assert_allclose(forward.record.z[:, 1:], by_hand(bank, q[:, 1:]), rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(added, forward.record.z @ bank.drives.T, rtol=1e-12)
    np.testing.assert_allclose(forward.record.q, q)


def test_single_precision_costs_each_part_its_own_error() -> None:
    found = {}
    for name, make in UNLIKE.items():
        of = make()
        run = Vectors(0.1 * swinging(of)[500:900], np.zeros((400, 2)), 0, 0)
        ahead = rounding.errors_before_converter(of, sections(of), run)
        found[name] = [float(f"{each:.4g}") for each in (*ahead[100], *ahead.max(axis=0))]
    assert found == {
        "an inverse": [2.686e-06, 1.909e-06, 2.988e-06, 2.487e-06],
        "an inverse with a given rate": [2.689e-06, 1.913e-06, 2.996e-06, 2.497e-06],
        "an inverse with an exponent": [2.719e-06, 1.909e-06, 3.003e-06, 2.487e-06],
        "a feedforward": [1.089e-06, 7.461e-07, 1.108e-06, 7.553e-07],
        "a feedforward that neither widens nor bends": [1.089e-06, 7.461e-07, 1.108e-06, 7.553e-07],
        "a feedforward with an exponent": [1.097e-06, 7.461e-07, 1.151e-06, 7.553e-07],
        "both": [3.775e-06, 2.655e-06, 4.09e-06, 3.242e-06],
        "neither": [7.114e-10, 1.14e-10, 2.74e-09, 2.031e-10],
        "neither, without a converter": [7.114e-10, 1.14e-10, 2.74e-09, 2.031e-10],
    }


def test_each_actuator_whose_plays_widen_is_compared_once_more_and_without_plays_nothing_widens() -> None:
    """Three actuators of which none, two or all widen, over four plays of which one has no threshold."""
    law = replace(
        unlike_law(by_difference=False),
        direct=np.array([50.0, -100.0, 20.0]),
        play_threshold=np.array([1e-4, 0.0, 3e-4, 2e-4]),
        play_weight=np.ones(4),
        play_actuator=np.array([0, 1, 1, 2]),
    )

    def cost(slopes: tuple[float, float, float], of: InverseLaw = law) -> Operations:
        return operations._inverse(replace(of, widening=np.array([[s, 50.0] for s in slopes])), 3, "single")

    none, two = cost((0.0, 0.0, 0.0)), cost((1e-4, 0.0, 2e-4))
    # each rate is held to its limit and multiplied by the slope; each slope and each play is asked whether it widens
    clamped = Operations(multiplications=1, comparisons=3) * 3
    assert two == none + clamped + Operations(comparisons=2 + 4, additions=3)
    assert cost((1e-4, 3e-4, 2e-4)) == two + Operations(comparisons=1)
    still = replace(law, play_threshold=np.zeros(0), play_weight=np.zeros(0), play_actuator=np.zeros(0, dtype=int))
    assert cost((1e-4, 0.0, 2e-4), still) == cost((0.0, 0.0, 0.0), still)


@pytest.mark.parametrize(("moves", "shown"), [(True, False), (False, True), (True, True)])
def test_states_are_rounded_once_for_each_product_that_reads_them(moves: bool, shown: bool) -> None:
    """Integrators alone move by what is read alone; a state keeps three bits below its word, another none."""
    state, output = np.zeros((2, 5), dtype=np.int64), np.zeros((1, 4), dtype=np.int64)
    state[0, 2], output[0, 3] = 5, 7
    form = FixedForm(
        16, (10, 11), (4, 6), (3,), fixed_form.Rows(state, (7, 6)), fixed_form.Rows(output, (8,)),
        (-9,), (9,), (), None,  # type: ignore[arg-type]
    )  # fmt: skip
    of = replace(plain(None), inverse=None)
    of = replace(of, system=lti.StateSpace(*(np.zeros((1, 1)) for _ in range(4))))
    nothing = operations.fixed_operations(of, form)
    if moves:
        state[1, :2] = 3, -2
    if shown:
        output[0, 1] = 4
    found = operations.fixed_operations(of, form)
    terms, reads = 2 * moves + shown, moves + shown
    assert found == replace(
        nothing,
        multiplications=nothing.multiplications + terms,
        additions=nothing.additions + terms + reads,  # half a step, where bits are dropped
        shifts=nothing.shifts + (1 + 2 + 2) * reads,
        comparisons=nothing.comparisons + (2 + 3 * 2) * reads,
    )
