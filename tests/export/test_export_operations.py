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
from microrad.core import lti
from microrad.core.arrays import Floats
from microrad.export.flight import c_code, fixed, operations
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
    return designs.flown(name, 1500)


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
        ("all", "double"),
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
@pytest.mark.parametrize(("precision", "trials"), [("double", 1), ("single", 3)])
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
    inputs = 0.2 * swinging(of)[:1500]
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
FIXED_AGAIN = {"no inverse", "rate given"}
"""What differs from another one by its numbers, or by a rate that is read and not computed."""


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
