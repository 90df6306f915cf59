"""Flight code: compiled, replayed against the kernel, fed with garbage, and read as a reviewer would."""

import ctypes
import hashlib
import json
import os
import re
import shutil
import subprocess
from dataclasses import dataclass, replace
from functools import cache, cached_property
from math import inf, nan, pi
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import designs
import several_axes
from microrad.core import kernels, lti
from microrad.export import choice
from microrad.export.flight import c_code
from microrad.export.flight import write as flight_write
from microrad.export.flight.build import BenchResult
from microrad.export.flight.operations import Operations
from microrad.export.flight.rounding import RoundingBound, rounding_bound
from microrad.export.flight.stack import StackUse
from microrad.export.flight.write import export_flight
from microrad.export.linear_part.modes import minimal
from microrad.export.linear_part.sections import sections
from microrad.export.records import ExportError, FlightController, Origin, Signal, Vectors
from microrad.export.templating import comment, real, render, table, terms
from microrad.loop import control, disturbance
from microrad.loop.control import AxisController, Drive, Timing
from microrad.loop.controller_study import Outlook
from microrad.loop.pointing_loop import loop as fine
from microrad.loop.pointing_loop.loop import PointingLoop, ReferenceFilter, with_inverse
from microrad.loop.sensor import OpticalSensor
from microrad.mirror import model as mirror
from microrad.mirror.hysteresis import NO_CREEP, BoucWen, Creep, PrandtlIshlinskii
from microrad.mission.file import load_mission
from shipped import SHIPPED, without_fine_pointing
from waiting import HANG_S

URAD = 1e-6
WARNINGS = ["-Wall", "-Wextra", "-Werror", "-pedantic", "-Wconversion", "-Wdouble-promotion", "-Wshadow"]
FLAGS = ["-std=c99", "-O2", *WARNINGS]
SANITIZERS = ["-g", "-fsanitize=address,undefined", "-fno-sanitize-recover=all"]
EXACT = 1e-12  # of the largest command
GENEROUS = RoundingBound(command_v=1e-3, samples=1, per_sample_v=0.0, words="For tests.")
PRECISIONS = ("double", "single")
one_precision = pytest.mark.parametrize("precision", [pytest.param("double", marks=pytest.mark.endurance), "single"])
NUMBER = {"double": np.float64, "single": np.float32}

pytestmark = pytest.mark.skipif(shutil.which("gcc") is None, reason="no gcc")

# ------------------------------------------------------------------------------------------------ compiled code

DRIVER = """
#include "{name}.h"
#include <stddef.h>
size_t state_size(void) {{ return sizeof({name}_state); }}
void begin({name}_state *state) {{ {name}_init(state); }}
void counters(const {name}_state *state, uint32_t *to)
{{ to[0] = state->saturated; to[1] = state->rate_clamped; to[2] = state->rejected; to[3] = state->faults; }}
void replay({name}_state *state, size_t samples, const {name}_real *m, {name}_real *command)
{{
    for (size_t k = 0; k < samples; k++, m += {readings}, command += {actuators})
        {name}_step(state, {arguments}, command);
}}
"""


BUILT = {}
"""Shared libraries by their compiler and their code."""


@dataclass(frozen=True)
class Counters:
    saturated: int
    rate_clamped: int
    rejected: int
    faults: int


class Code:
    """The generated code as a shared library, with a state to each instance of `begin`."""

    def __init__(self, folder, of, precision="double", name="flown", compiler="gcc", bound=GENEROUS):
        self.folder, self.of, self.name, self.number = folder, of, name, NUMBER[precision]
        folder.mkdir(parents=True, exist_ok=True)
        self.files = c_code.flight_code(of, sections(of), name, precision, bound)
        for file, text in self.files.items():
            (folder / file).write_text(text, encoding="utf-8")
        places = np.cumsum([0, *(each.size for each in of.inputs)])
        arguments = ", ".join(f"m + {at}" for at in places[:-1])
        self.driver = DRIVER.format(name=name, readings=places[-1], actuators=of.actuators, arguments=arguments)
        self.compiler = compiler

    @cached_property
    def path(self):
        """The shared library, compiled once for all that have the same code."""
        same = (self.compiler, self.driver, *self.files.values())
        if same not in BUILT:
            (self.folder / "driver.c").write_text(self.driver)
            sources = [self.folder / f"{self.name}.c", self.folder / "driver.c"]
            BUILT[same] = self.folder / "flown.so"
            command = [self.compiler, *FLAGS, "-shared", "-fPIC", "-o", BUILT[same], *sources, "-lm"]
            subprocess.run(command, check=True, timeout=HANG_S)
        return BUILT[same]

    @cached_property
    def library(self):
        found = ctypes.CDLL(str(self.path))
        found.state_size.restype = ctypes.c_size_t
        return found

    def begin(self):
        state = (ctypes.c_char * self.library.state_size())()
        self.library.begin(state)
        return state

    def replay(self, inputs, state=None):
        state = self.begin() if state is None else state
        m = np.ascontiguousarray(inputs, dtype=self.number)
        command = np.empty((len(m), self.of.actuators), dtype=self.number)
        pointers = (each.ctypes.data_as(ctypes.c_void_p) for each in (m, command))
        self.library.replay(state, ctypes.c_size_t(len(m)), *pointers)
        return command

    def counters(self, state):
        found = (ctypes.c_uint32 * 4)()
        self.library.counters(state, found)
        return Counters(*found)

    def run(self, inputs):
        """Commands and counters from rest."""
        state = self.begin()
        return self.replay(inputs, state), self.counters(state)


def bench(code, vectors, target="check", passes=1):
    """Status and numbers of the bench that the Makefile builds, over these vectors."""
    (code.folder / "vectors.csv").write_text(c_code.vectors_text(code.of, vectors), encoding="utf-8")
    words = ["make", "-s", "-C", code.folder, target, "CC=gcc", f"PASSES={passes}"]
    words += ["CFLAGS=-std=c99 -O1"] if target == "sanitized" else []  # quicker to compile
    done = subprocess.run(words, check=False, capture_output=True, text=True, timeout=HANG_S)
    lines = [line.split() for line in done.stdout.splitlines()]
    return done.returncode, {line[0]: float(line[1]) for line in lines if len(line) == 2}, done.stderr


# ------------------------------------------------------------------------------------------------ controllers


def mission(folder, *changes, whole=True):
    text = SHIPPED.read_text(encoding="utf-8")
    text = text if whole else without_fine_pointing(text)
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    path = folder / "mission.toml"
    path.write_text(text, encoding="utf-8")
    return load_mission(path)


NO_CONVERTER = ('drive_resolution = "0.305 mV"', 'drive_resolution = "0 V"')
OFTEN = bool(os.environ.get("MICRORAD_ENDURANCE"))
POINTING = {"PI + inverse": 20_000 if OFTEN else 2000, "PI + inverse in series": 100_000 if OFTEN else 4000}
"""Samples by controller: in series the jitter goes through the inverse, else the known part of the error alone."""


@pytest.fixture(scope="module", params=POINTING)
def flown(request):
    """The controller and a record of the loop in its jitter."""
    chosen = designs.without_converter(request.param)
    return choice.flight_controller(chosen), choice.vectors(chosen, POINTING[request.param])


@pytest.fixture(scope="module")
def shipped():
    return designs.chosen("PI + inverse in series")


BOUC_WEN = BoucWen(89e-6, -2.96e-7, -22e-6, 4.7e-4, 2.4, 0.6, 3770.0, 6.0)
PRINTED = replace(BOUC_WEN, epsilon_rad_v=-48e-6, alpha_1_v=38.421, beta_1_v=34.635)
PLAYS = PrandtlIshlinskii((0.0, 0.1, 0.4, 1.0, 2.0), (50e-6, 12e-6, 12e-6, 8e-6, 7e-6))
CREEP = Creep((4e-6, 4e-6), (0.01, 0.1))
PAIRS = {  # the models of two actuators, so that each pair is compiled once
    "printed, widening plays that creep": (
        (PRINTED, NO_CREEP),
        (replace(PLAYS, widening_s=1e-4, rate_limit_v_s=3770.0), CREEP),
    ),
    "generalised that creeps, plays": ((replace(BOUC_WEN, gamma_1_v=0.4, eta_1_v=-0.3), CREEP), (PLAYS, NO_CREEP)),
    "exponent 2 without a limit of rate, plays that creep": (
        (replace(BOUC_WEN, exponent=2.0, rate_limit_v_s=inf, delta_s_v=0.0), NO_CREEP),
        (PLAYS, CREEP),
    ),
}


@dataclass(frozen=True)
class Sweep:
    """A sine that grows for 20 ms."""

    amplitude_rad: float
    freq_hz: float

    def at(self, time_s):
        t = np.asarray(time_s)
        return self.amplitude_rad * np.sin(2 * pi * self.freq_hz * t) * np.minimum(1.0, (t / 0.02) ** 2)


def pair_loop(models, resolution_v=0.0):
    """Two coupled axes at 5 kHz whose references go beyond the identified rate and, at times, beyond the limits."""
    parts = [mirror.assemble("static", "static", None, *each) for each in models]
    lines = disturbance.wheels(1.0, (20.0, 130.0), (20 * URAD, 5 * URAD), convention="per-axis")
    return PointingLoop(
        mirror=mirror.combine(*parts),
        optics=np.array([[1.0, 0.1], [-0.2, 0.9]]),
        drive=Drive(-2.5, 2.5, 5e3, inf, resolution_v, 0.0),
        timing=Timing(2e-4, 10, 10),
        disturbances=((lines,), (lines,)),
        optical=OpticalSensor(URAD, inf, 0.0, 1, 0),
        gauge=None,
        references=(Sweep(250 * URAD, 350.0), Sweep(200 * URAD, 410.0)),
    )


def pi_axis(loop):
    ki = 2 * pi * 100.0 / fine.nominal_axis_gain(loop)
    s = control.pid(control.Gains(ki / (2 * pi * 1500.0), ki, 0.0, 0.0), loop.timing.period_s)
    none = np.zeros((1, 1))
    system = lti.StateSpace(s.A, np.hstack([s.B, none]), s.C, np.hstack([s.D, none]))
    return AxisController("PI", system, s.B / s.D)


@cache
def pair(models, resolution_v=0.0, in_series=True):
    """Controller and recorded run of a pair's loop, around a mirror of plays: those are quick, whatever is inverted."""
    of = designs.chosen("PI + inverse in series")
    loop = pair_loop(models, resolution_v)
    inverse = control.inverse(loop.mirror)
    made = with_inverse("pair", loop, pi_axis(loop), inverse, ReferenceFilter(1000.0), in_series)
    quick = replace(loop, mirror=pair_loop(((PLAYS, NO_CREEP),) * 2).mirror)
    chosen = replace(of, scene=replace(of.scene, loop=quick), controller=made)
    of = choice.flight_controller(chosen)
    return of, choice.vectors(chosen, 1000 if 1.0 in of.inverse.bouc_wen[:, kernels.POWER] else 2500)


# ------------------------------------------------------------------------------------------------ the same numbers


def difference(code, vectors):
    """Largest difference from the recorded commands over the largest of them, and the counters."""
    found, counters = code.run(vectors.inputs)
    return np.max(np.abs(found - vectors.commands)) / np.max(np.abs(vectors.commands)), counters


@pytest.mark.promise("readme-14")
@pytest.mark.promise("export-9", "export-14")
def test_double_precision_is_the_kernel_over_the_samples_of_the_jitter(flown, tmp_path):
    of, vectors = flown
    code = Code(tmp_path, of)
    off, counters = difference(code, vectors)
    assert vectors.inputs.shape[0] == POINTING[of.name]
    assert 0.0 < off < EXACT
    assert counters == Counters(vectors.saturated, vectors.rate_clamped, 0, 0)
    status, numbers, _ = bench(code, vectors, passes=0)
    assert status == 0
    peak = np.max(np.abs(vectors.commands))
    assert_allclose(numbers["largest_difference_v"], off * peak, rtol=1e-5)
    assert_allclose([numbers["peak_command_v"], numbers["bound_v"]], [peak, EXACT * peak], rtol=1e-5)
    assert numbers["samples"] == POINTING[of.name]
    assert "worst_step_ns" not in numbers


@pytest.mark.promise("readme-14")
@pytest.mark.promise("export-14", "export-15")
def test_single_precision_stays_within_the_bound_that_it_states(flown, tmp_path):
    of, vectors = flown
    bound = rounding_bound(of, sections(of), vectors)
    code = Code(tmp_path, of, "single", bound=bound)
    off, counters = difference(code, vectors)
    found = off * np.max(np.abs(vectors.commands))
    assert 1e-8 < found <= bound.command_v < (5e-3 if "series" in of.name else 0.5)
    assert found < 1e-5 or "series" not in of.name
    assert counters == Counters(vectors.saturated, vectors.rate_clamped, 0, 0)
    status, numbers, _ = bench(code, vectors, passes=0)
    assert status == 0
    assert_allclose(numbers["bound_v"], bound.command_v, rtol=1e-5)
    stated = f"within {bound.command_v:.3g} V of double precision over {len(vectors.inputs)} recorded"
    assert stated in code.files["flown.h"]


# ------------------------------------------------------------------------------------------------ several axes


@pytest.mark.promise("mirror-file-30")
@pytest.mark.promise("export-4")
@pytest.mark.parametrize("samples", [10_000, pytest.param(100_000, marks=pytest.mark.endurance)])
def test_a_controller_of_several_axes_is_the_kernel_over_many_samples(samples, tmp_path):
    chosen = designs.of_three_actuators()
    of, vectors = choice.flight_controller(chosen), choice.vectors(chosen, samples)
    assert [each.name for each in of.inputs] == ["optical_error_rad"]
    assert (of.actuators, of.bias_v, vectors.inputs.shape) == (3, 50.0, (samples, 2))
    off, counters = difference(Code(tmp_path, of), vectors)
    print(f"off by {off:.2g} of the largest command")
    assert 0.0 < off < EXACT
    assert counters == Counters(vectors.saturated, 0, 0, 0)
    assert ("modulus margin of all axes", "") in [(name, unit) for name, _, unit in of.margins]


def test_a_controller_of_several_axes_stays_within_its_bound_in_single_precision(tmp_path):
    chosen = designs.of_three_actuators()
    of, vectors = choice.flight_controller(chosen), choice.vectors(chosen, 2000)
    bound = rounding_bound(of, sections(of), vectors)
    off, _ = difference(Code(tmp_path, of, "single", bound=bound), vectors)
    found = off * np.max(np.abs(vectors.commands))
    assert 1e-8 < found <= bound.command_v < 5e-2


@one_precision
def test_garbage_does_not_take_several_axes_beyond_their_limits(precision, tmp_path):
    chosen = designs.of_three_actuators()
    of, vectors = choice.flight_controller(chosen), choice.vectors(chosen, 1000)
    code = Code(tmp_path, of, precision)
    garbage_stays_within_limits(code, of, vectors)


@pytest.mark.promise("export-4")
def test_actuators_that_rest_at_different_biases_are_refused():
    mirror = several_axes.three_actuators()
    first, *others = mirror.actuators
    with pytest.raises(ExportError, match=r"rest at 40 V, 50 V, and exported code counts all commands from one bias"):
        choice.choose_coupled(
            several_axes.mission(), replace(mirror, actuators=(replace(first, bias_v=40.0), *others)), "PI"
        )


def test_a_controller_of_several_axes_that_leaves_too_much_is_refused(tmp_path):
    chosen = replace(designs.of_three_actuators(), left=Outlook(1e-6, 2e-6))
    with pytest.raises(ExportError, match=r"LQG leaves 2 µrad rms an axis .* 2 times the 1 µrad"):
        export_flight(chosen, tmp_path / "flight")
    assert list(tmp_path.iterdir()) == []


# ------------------------------------------------------------------------------------------------ inverses


@pytest.mark.promise("export-9", "export-10")
@pytest.mark.parametrize("name", PAIRS)
def test_every_model_of_hysteresis_and_creep_on_several_actuators(name, tmp_path):
    """With rates beyond the limit and commands beyond the stroke, which are counted as the kernel does."""
    of, vectors = pair(PAIRS[name])
    assert vectors.saturated > 50
    assert (vectors.rate_clamped > 50) == (("exponent" not in name and "generalised" not in name) or "gen" in name)
    off, counters = difference(Code(tmp_path / "double", of), vectors)
    assert off < c_code.bound_share(of) == (1e-10 if "exponent" in name else EXACT)
    assert counters == Counters(vectors.saturated, vectors.rate_clamped, 0, 0)
    off, counters = difference(Code(tmp_path / "single", of, "single"), vectors)
    assert 1e-8 < off < 2e-5
    assert_allclose([counters.saturated, counters.rate_clamped], [vectors.saturated, vectors.rate_clamped], atol=3)
    assert (counters.rejected, counters.faults) == (0, 0)


ADVANCE = """
#include "p_hysteresis.h"
void advance(int n, const p_bouc_wen *e, p_real *h, const p_real *travel, const p_real *rate, uint32_t *faults);
void advance(int n, const p_bouc_wen *e, p_real *h, const p_real *travel, const p_real *rate, uint32_t *faults)
{
    for (int i = 0; i < n; i++)
        h[i] = p_bouc_wen_advance(h[i], travel[i], rate[i], e, faults);
}
"""


def advancer(folder, precision, model):
    """The header alone, compiled: h, travel and rate to the new h and the faults."""
    (folder / "p_hysteresis.h").write_text(render("hysteresis.h.j2", name="p", precision=precision))
    (folder / "p.c").write_text(ADVANCE)
    subprocess.run(["gcc", *FLAGS, "-shared", "-fPIC", "-o", folder / "p.so", folder / "p.c", "-lm"], check=True)
    library, row = ctypes.CDLL(str(folder / "p.so")), kernels.bouc_wen_rows([model.row])[0].astype(NUMBER[precision])

    def run(*columns):
        h, travel, rate = (np.ascontiguousarray(each, dtype=row.dtype).copy() for each in columns)
        faults = ctypes.c_uint32(0)
        pointers = [each.ctypes.data_as(ctypes.c_void_p) for each in (row, h, travel, rate)]
        library.advance(h.size, *pointers, ctypes.byref(faults))
        return h, faults.value

    return run


@pytest.mark.promise("export-5")
@pytest.mark.parametrize("precision", PRECISIONS)
def test_a_step_of_bouc_wen_is_exact_however_long_and_keeps_h_where_it_has_no_number(precision, tmp_path):
    model = replace(BOUC_WEN, gamma_1_v=0.4, eta_1_v=-0.3)
    advance, rng = advancer(tmp_path, precision, model), np.random.default_rng(5)
    travel = rng.standard_normal(5000) * 10.0 ** rng.uniform(-6, 2, 5000)
    rate = np.clip(travel / 2e-5, -3770.0, 3770.0)
    h = model.settled_rad * rng.uniform(-1, 1, 5000) * (np.arange(5000) % 7 > 0)
    grown = model.epsilon_rad_v * np.exp(model.delta_s_v * np.abs(rate))
    wanted = np.array(
        [kernels.bouc_wen_step(*each, 2.4, 0.6, 0.4, -0.3) for each in zip(h, travel, grown, strict=True)]
    )
    found, faults = advance(h, travel, rate)
    assert faults == 0
    assert np.count_nonzero(h * wanted < 0.0) > 500  # they cross zero
    unit = np.finfo(NUMBER[precision]).eps
    assert_allclose(found, wanted, rtol=0, atol=20 * unit * np.max(np.abs(wanted)))
    bad = np.array([inf, nan, 1.0, 1.0, -inf])
    found, faults = advance(np.full(5, 1e-6), bad, [0.0, 0.0, nan, 3e38, 0.0])
    assert faults == 5
    assert_allclose(found, 1e-6, rtol=unit)


def without_a_play(of):
    keep = np.arange(of.inverse.play_threshold.size) > 0
    parts = {key: getattr(of.inverse, key)[keep] for key in ("play_threshold", "play_weight", "play_actuator")}
    return replace(of, inverse=replace(of.inverse, **parts))


@pytest.mark.promise("export-9")
@pytest.mark.endurance
def test_each_part_of_an_inverse_counts(tmp_path):
    """The agreement above is not for want of hysteresis: without one play, creep or gamma it is lost."""
    of, vectors = pair(PAIRS["printed, widening plays that creep"])
    law = of.inverse
    changes = (
        without_a_play(of),
        replace(of, inverse=replace(law, lag_weight=0.99 * law.lag_weight)),
        replace(of, inverse=replace(law, widening=law.widening * [[0.99, 1.0]])),
        replace(of, inverse=replace(law, direct=0.999 * law.direct)),
        replace(of, anti_windup=0.9 * of.anti_windup),
    )
    for number, changed in enumerate(changes):
        off, _ = difference(Code(tmp_path / str(number), changed), vectors)
        assert off > 1e-6, number


@pytest.mark.promise("export-13")
def test_the_converter_rounds_as_the_kernels(shipped, tmp_path):
    of, vectors = choice.flight_controller(shipped), choice.vectors(shipped, 2000)
    off, counters = difference(Code(tmp_path, of), vectors)
    assert off == 0.0
    assert counters == Counters(0, 0, 0, 0)
    coarse = replace(of, resolution_v=1.01 * of.resolution_v)
    off, _ = difference(Code(tmp_path / "coarse", coarse), vectors)
    assert off * np.max(np.abs(vectors.commands)) > 0.4 * of.resolution_v


STATIC = 'composition = "cascade"', 'composition = "static"'
WIDENING_PLAYS = """[mirror.prandtl_ishlinskii]
thresholds = ["0 V", "0.5 V", "2 V"]
weights = ["60 urad/V", "20 urad/V", "9 urad/V"]
widening = "50 us"

[mirror.creep]
time_constants = ["10 ms", "100 ms"]
weights = ["2 urad/V", "2 urad/V"]

"""


def mirror_of(tables):
    """Changes of the shipped mission that put other tables in place of its mirror's."""
    text = SHIPPED.read_text(encoding="utf-8")
    given = text[text.index("[mirror.linear]") : text.index("[amplifier]")]
    return (given, tables), STATIC


EXPONENT = 'beta = "34.635 1/V" ', 'exponent = 2\nbeta = "34.635 1/V" '


@pytest.mark.parametrize(
    "changes",
    [
        pytest.param((), id="Eq. 3"),
        pytest.param((EXPONENT,), id="exponent 2", marks=pytest.mark.endurance),
        pytest.param(mirror_of(WIDENING_PLAYS), id="plays"),
    ],
)
def test_the_controller_of_fig_8_takes_its_rate_from_two_samples(changes, tmp_path):
    """The loop of [control]: one axis at 50 kHz, and an inverse that the reference alone drives."""
    chosen = choice.choose(mission(tmp_path, NO_CONVERTER, *changes, whole=False), choice.PID_WITH_INVERSE)
    of, vectors = choice.flight_controller(chosen), choice.vectors(chosen, 5000)
    assert of.inverse.by_difference
    code = Code(tmp_path, of)
    off, counters = difference(code, vectors)
    assert off < EXACT
    assert counters == Counters(vectors.saturated, vectors.rate_clamped, 0, 0)
    off, _ = difference(Code(tmp_path / "single", of, "single"), vectors)
    assert 1e-9 < off < 1e-4


@pytest.mark.parametrize("name", [pytest.param("PI", marks=pytest.mark.endurance), "LQG"])
def test_controllers_without_an_inverse_have_no_header_for_it(name, tmp_path):
    chosen = designs.without_converter(name)
    of, vectors = minimal(choice.flight_controller(chosen)), choice.vectors(chosen, 3000)
    code = Code(tmp_path, of)
    off, counters = difference(code, vectors)
    assert off < EXACT
    assert counters == Counters(0, 0, 0, 0)
    assert set(code.files) == {"flown.h", "flown.c", "flown_bench.c", "Makefile"}
    assert "inverse" not in code.files["flown.c"]
    off, _ = difference(Code(tmp_path / "single", of, "single"), vectors)
    assert 1e-9 < off < 1e-4


@pytest.mark.skipif(shutil.which("clang") is None, reason="no clang")
@pytest.mark.parametrize("precision", PRECISIONS)
def test_another_compiler_makes_the_same_of_it(precision, tmp_path):
    of, vectors = pair(PAIRS["printed, widening plays that creep"])
    off, _ = difference(Code(tmp_path, of, precision, compiler="clang"), vectors)
    assert off < (EXACT if precision == "double" else 2e-5)


# ------------------------------------------------------------------------------------------------ garbage

GARBAGE = (inf, -inf, nan, 1e38, -1e38, 1e300, -1e300, 5e-324, -1e-310, 1e-40, -0.0, 0.1, -0.1, 0.100001)
LIMIT_RAD = 0.1


def garbage_stays_within_limits(code, of, vectors):
    """A run with garbage among its readings, at times under the sanitizers: rejected, counted, held; the readings."""
    bad = spoiled(vectors.inputs, code.number)
    good, rejected = held(bad)
    found, counters = code.run(bad)
    assert np.all(np.isfinite(found))
    assert np.max(np.abs(found)) <= of.maximum_v
    assert len(bad) / 10 < rejected == counters.rejected
    assert_array_equal(found, code.run(good)[0])
    if OFTEN:  # compiled once more
        replayed = replace(vectors, inputs=bad.astype(float), commands=found.astype(float))
        status, numbers, words = bench(code, replayed, "sanitized", passes=0)
        assert (status, words) == (0, "")
        assert numbers["rejected"] == rejected
    return bad


def spoiled(sound, number):
    """Five samples of garbage or of flipped signs after each twenty sound ones, in the precision."""
    rng = np.random.default_rng(8)
    found = sound.copy()
    for begin in range(20, len(found), 25):
        at = slice(begin, begin + 5)
        bad = rng.choice(GARBAGE, found[at].shape)
        found[at] = np.where(rng.random(bad.shape) < 0.3, -found[at], bad)
    with np.errstate(over="ignore"):  # what single precision does not hold is infinite
        return found.astype(number)


def held(inputs):
    """What the code is to take for them: the last accepted number, 0 at first; and how many it rejects."""
    with np.errstate(invalid="ignore"):
        bad = ~(np.abs(inputs) <= inputs.dtype.type(LIMIT_RAD))
    found = np.zeros_like(inputs)
    for k, (row, wrong) in enumerate(zip(inputs, bad, strict=True)):
        found[k] = np.where(wrong, found[k - 1] if k else 0.0, row)
    return found, int(np.count_nonzero(bad))


FREE = replace(PRINTED, rate_limit_v_s=inf, delta_s_v=0.0)
FUZZED = {
    "printed, widening plays that creep": PAIRS["printed, widening plays that creep"],
    "without a limit, exponent 2": ((FREE, CREEP), (replace(BOUC_WEN, exponent=2.0), NO_CREEP)),
}


@pytest.mark.promise("export-6", "export-8", "export-13")
@pytest.mark.parametrize(
    ("name", "precision"),
    [
        pytest.param("printed, widening plays that creep", "double", marks=pytest.mark.endurance),
        pytest.param("without a limit, exponent 2", "double", marks=pytest.mark.endurance),
        ("printed, widening plays that creep", "single"),
    ],
)
def test_garbage_is_held_off_and_never_leaves_the_limits(name, precision, tmp_path):
    of, vectors = pair(FUZZED[name], resolution_v=0.35e-3)  # 2.5 V would be rounded to 2.50005 V
    if not OFTEN:
        vectors = replace(vectors, inputs=vectors.inputs[:1000], commands=vectors.commands[:1000])
    code = Code(tmp_path, of, precision)
    bad = spoiled(vectors.inputs, code.number)
    good, rejected = held(bad)
    found, counters = code.run(bad)
    assert np.all(np.isfinite(found))
    assert 2.49 < np.max(np.abs(found)) <= 2.5
    assert len(bad) / 10 < rejected == counters.rejected
    again, held_counters = code.run(good)
    assert_array_equal(found, again)
    assert held_counters == replace(counters, rejected=0)
    assert (counters.faults > 0) == ("without" in name)
    state = code.begin()
    code.replay(bad, state)
    behind = code.replay(vectors.inputs[:200], state)
    assert min(len(np.unique(drive)) for drive in behind.T) > 50  # they move, and not from limit to limit alone
    assert code.counters(state).rejected == rejected
    replayed = replace(vectors, inputs=bad.astype(float), commands=found.astype(float))
    status, numbers, words = bench(code, replayed, "sanitized", passes=0)
    assert (status, words) == (0, "")
    assert (numbers["rejected"], numbers["faults"]) == (rejected, counters.faults)
    if "exponent" not in name and precision == "double":  # the recorded run, whose counts leave the limits
        assert np.max(np.abs(vectors.commands)) > 2.5
        assert difference(code, c_code.within_limits(of, vectors))[0] < EXACT < difference(code, vectors)[0]


@pytest.mark.promise("export-5")
@pytest.mark.endurance
def test_the_sanitizers_would_see_it(shipped, tmp_path):
    """A row beyond the outputs, written into the generated code, ends the same run."""
    of, vectors = choice.flight_controller(shipped), choice.vectors(shipped, 20)
    code = Code(tmp_path, of)
    text = code.files["flown.c"]
    spoilt = text.replace("{2, 0, ", "{7, 0, ", 1)
    assert spoilt != text
    (tmp_path / "flown.c").write_text(spoilt)
    status, _, words = bench(code, vectors, "sanitized")
    assert status != 0
    assert "runtime error" in words or "AddressSanitizer" in words


def steady(code, samples, garbage=()):
    """The loop around a mirror that just has a gain, at a constant reference: the commands, by sample."""
    of, state = code.of, code.begin()
    command, found = np.zeros(of.actuators), []
    for k in range(samples):
        wanted = np.full(2, 60 * URAD)
        m = np.concatenate([wanted - 89e-6 * command, wanted])
        if k in garbage:
            m = garbage[k]
        command = code.replay(m[None], state)[0].astype(float)
        found.append(command)
    return np.array(found)


@pytest.mark.promise("export-8")
@pytest.mark.parametrize("precision", PRECISIONS)
def test_the_loop_recovers_once_its_inputs_are_sound_again(precision, shipped, tmp_path):
    of = choice.flight_controller(shipped)
    code = Code(tmp_path, replace(of, resolution_v=0.0), precision)
    rng = np.random.default_rng(3)
    with np.errstate(over="ignore"):
        garbage = {k: rng.choice(GARBAGE, 4).astype(code.number) for k in range(100, 400)}
    quiet, disturbed = steady(code, 3000), steady(code, 3000, garbage)
    assert_allclose(quiet[-1], 60 / 89, rtol=1e-3)
    assert np.max(np.abs(disturbed[100:400] - quiet[100:400])) > 1.0
    assert_allclose(disturbed[-1], quiet[-1], rtol=1e-3)


# ------------------------------------------------------------------------------------------------ state and source


@pytest.mark.promise("readme-14")
@pytest.mark.promise("export-7")
def test_all_memory_is_the_callers(tmp_path):
    of, vectors = pair(PAIRS["printed, widening plays that creep"])
    code = Code(tmp_path, of)
    alone, other = code.run(vectors.inputs)[0], code.run(-vectors.inputs)[0]
    one, two = code.begin(), code.begin()
    fresh = bytes(one)
    both = [[code.replay(sign * m[None], s)[0] for sign, s in ((1, one), (-1, two))] for m in vectors.inputs[:500]]
    assert_array_equal(np.array(both)[:, 0], alone[:500])
    assert_array_equal(np.array(both)[:, 1], other[:500])
    assert np.max(np.abs(alone - other)) > 1.0
    assert bytes(one) != fresh
    code.library.begin(one)
    code.library.begin(one)
    assert bytes(one) == fresh


@pytest.mark.promise("export-11")
@one_precision
def test_a_drive_that_is_no_number_is_not_given_out(precision, tmp_path):
    """A gain of exp(-2500) and an h of exp(1200): the last command stays, and once the inputs are sound it recovers."""
    endless = replace(PRINTED, rate_limit_v_s=inf, d2_s_v=1e-3)
    of, vectors = pair(((endless, CREEP), (PLAYS, NO_CREEP)), in_series=False)
    settling = np.concatenate([np.zeros((60_000, 4)), 0.1 * vectors.inputs[:2000]])
    jump = np.array([[0.0, 0.0, 0.09, 0.0]])
    code = Code(tmp_path / "around", of, precision)
    before, quiet = code.begin(), code.replay(1e-3 * vectors.inputs[:50])
    code.replay(1e-3 * vectors.inputs[:50], before)
    assert code.counters(before) == Counters(0, 0, 0, 0)
    found = code.replay(jump, before)
    assert 0.0 < abs(found[0, 0]) < 1.0
    assert found[0, 0] == quiet[-1, 0]
    assert code.counters(before).faults >= 2  # the command and the lags
    behind = code.replay(settling, before)
    assert len(np.unique(behind[-500:, 0])) > 50
    first = Code(tmp_path / "above", replace(of, minimum_v=1.0), precision).replay(jump)
    assert first[0, 0] == 1.0  # the nearest to 0 within the limits


@pytest.mark.promise("export-14")
def test_single_precision_keeps_what_rounding_leaves_out(tmp_path):
    """Increments a thousand times smaller than the last digit of the integrators: 1e-5 of the command, all told."""
    of = choice.flight_controller(designs.without_converter("PI"))
    inputs = np.full((22_000, 4), 1e-10)
    inputs[:2000] = 1e-6
    inputs = inputs[:, : sum(each.size for each in of.inputs)]
    double = Code(tmp_path / "double", of).replay(inputs)
    single = Code(tmp_path / "single", of, "single").replay(inputs)
    grown = double[-1, 0] - double[2000, 0]
    assert 1e-5 < abs(grown / double[-1, 0]) < 1e-2
    assert_allclose(single[-1, 0] - single[2000, 0], grown, rtol=0.02)


def functions(text):
    """Names of the functions and their bodies, in the order of the file."""
    found = re.findall(r"^(?:static )?(?:inline )?\w+ (\w+)\((?:[^;{}]*)\)\n\{\n(.*?)^\}", text, re.M | re.S)
    return [(name, re.sub(r"/\*.*?\*/", "", body, flags=re.S)) for name, body in found]


ALLOWED = {"exp", "expm1", "log1p", "floor", "pow", "fabs", "fmin", "fmax"}


@pytest.mark.promise("readme-14")
@pytest.mark.promise("export-7")
@pytest.mark.parametrize("precision", PRECISIONS)
def test_no_heap_no_recursion_no_memory_of_its_own_and_bounded_loops(precision, tmp_path):
    """Each function calls only those that stand above it, so none comes back to itself."""
    of, _ = pair(PAIRS["printed, widening plays that creep"])
    code = Code(tmp_path, of, precision)
    text = code.files["flown_hysteresis.h"] + code.files["flown.c"]
    names = [name for name, _ in functions(text)]
    assert len(names) == len(set(names)) == text.count("\n{\n") > 20
    for place, (name, body) in enumerate(functions(text)):
        assert not [later for later in names[place:] if re.search(rf"\b{later}\(", body)], name
        assert not re.search(r"\b(while|goto|do|malloc|calloc|realloc|static)\b", body), name
        for bound in re.findall(r"for \([^;]*; \w+ < ([^;]*);", body):
            assert re.fullmatch(r"[A-Z_]+|count", bound), bound
    variables = [line for line in text.splitlines() if line.startswith("static ") and "(" not in line]
    assert len(variables) > 10
    assert all(line.startswith("static const ") for line in variables)
    subprocess.run(["gcc", *FLAGS, "-c", "-o", tmp_path / "flown.o", tmp_path / "flown.c"], check=True)
    symbols = subprocess.run(["nm", tmp_path / "flown.o"], check=True, capture_output=True, text=True).stdout
    kinds = {line.split()[-1]: line.split()[-2] for line in symbols.splitlines()}
    assert set(kinds.values()) <= set("TtUr")
    outside = {name for name, kind in kinds.items() if kind == "U"} - {"_GLOBAL_OFFSET_TABLE_", "memset"}
    assert outside <= {each + ("f" if precision == "single" else "") for each in ALLOWED}
    assert "exp" + ("f" if precision == "single" else "") in outside
    assert {name for name, kind in kinds.items() if kind == "T"} == {"flown_init", "flown_step"}


@pytest.mark.promise("readme-14")
@pytest.mark.promise("export-1", "export-5", "export-12", "export-14")
def test_the_header_says_what_it_is(shipped, tmp_path):
    of = choice.flight_controller(shipped)
    text = Code(tmp_path, of, name="pi_inverse_in_series").files["pi_inverse_in_series.h"]
    assert f'controller "{of.name}"' in text
    joined = " ".join(text.replace("\n *", " ").split())
    for words in (
        of.origin.mission,
        of.origin.mission_sha256,
        of.origin.mirror,
        "Period: 0.0002 s (5000 Hz)",
        "Linear part: 6 states in 4 blocks (modal form).",
        "Inverse of hysteresis: 2 Bouc-Wen element(s); taken at the target's rate, from the linear part.",
        "Double precision: within 1e-12 of the largest command",
        *(f"{margin} {value:.4g} {unit}".rstrip() for margin, value, unit in of.margins),
        "#define PI_INVERSE_IN_SERIES_OPTICAL_ERROR_LIMIT_RAD 0.1\n",
        "#define PI_INVERSE_IN_SERIES_RESOLUTION_V 0.000305\n",
        "optical_error_rad (rad): line-of-sight error (wanted less actual) from the optical sensor, by axis.",
        "go on stepping with an error of 0",
        "the amplifier's input is the bias plus the command, and the mirror's angle rises with it.",
        f"#define PI_INVERSE_IN_SERIES_BIAS_V {of.bias_v!r}\n",
        "gives out the commands (V from the bias)",
    ):
        assert words.strip() in (text if "\n" in words else joined), words
    assert max(map(len, text.splitlines())) <= 120


@pytest.mark.promise("export-12")
@pytest.mark.skipif(shutil.which("g++") is None, reason="no g++")
def test_it_is_called_from_c_plus_plus(shipped, tmp_path):
    code = Code(tmp_path, choice.flight_controller(shipped))
    text = (
        '#include "flown.h"\nint main() { flown_state s; flown_init(&s); return s.faults + (s.command_v[0] != 0.0); }\n'
    )
    (tmp_path / "use.cpp").write_text(text)
    subprocess.run(["g++", *WARNINGS, "-o", "use", "use.cpp", code.path], cwd=tmp_path, check=True)
    assert subprocess.run([tmp_path / "use"], check=False).returncode == 0


def test_a_unit_with_a_stroke_makes_a_constant():
    (found,) = c_code._readings((Signal("wanted_rad_s", 2, "rad/s", "rate", 3.0),))
    assert (found["NAME"], found["UNIT"]) == ("WANTED", "RAD_S")


@pytest.mark.promise("export-15")
def test_a_bound_that_is_none_is_said_in_the_header(shipped):
    of = choice.flight_controller(shipped)
    none = RoundingBound(command_v=of.maximum_v - of.minimum_v, samples=1, per_sample_v=0.0, words="It is not bounded.")
    header = c_code.flight_code(of, sections(of), "flown", "single", none)["flown.h"]
    assert "Single precision. It is not bounded." in header


def test_words_of_a_mission_cannot_become_code(shipped, tmp_path):
    """A comment's end, a trigraph, an end of line, a text that turns around: compiled, and nothing defined."""
    hostile = Origin("a */ int evil; /* b ??/\n#error c \\", "0" * 64, "d\u202e */*/ e")
    of = replace(choice.flight_controller(shipped), origin=hostile, name="*/ #error /*")
    code = Code(tmp_path, of, name="x" * 31)
    assert code.path.is_file()
    files = code.files
    plain = re.sub(r"/\*.*?\*/", "", "".join(files.values()), flags=re.S)
    assert "evil" not in plain
    assert "#error c" not in plain
    assert "evil" in files["x" * 31 + ".h"]
    assert comment("a */ b") == "a * / b"
    assert comment("a /* b") == "a / * b"
    assert comment("a /*/ b */* c") == "a / * / b * / * c"
    assert comment("what??/ C:\\new\nline") == "what? ?/ C:/new line"
    assert comment("") == comment(" ") == ""
    assert comment("word " * 40, " * ").count("\n * ") == 1


@pytest.mark.promise("export-5", "export-22")
def test_the_bench_finds_what_is_off_and_times_the_steps(shipped, tmp_path):
    of, vectors = choice.flight_controller(shipped), choice.vectors(shipped, 300)
    code = Code(tmp_path, of)
    status, numbers, _ = bench(code, vectors, passes=3)
    assert status == 0
    assert numbers["worst_step_ns"] >= numbers["median_step_ns"] > 0.0
    assert numbers["clock_ns"] > 0.0
    off = vectors.commands.copy()
    off[200, 1] += 2e-12 * np.max(np.abs(off))
    status, numbers, _ = bench(code, replace(vectors, commands=off))
    assert status != 0
    assert numbers["largest_difference_v"] > numbers["bound_v"] > 0.0
    program = tmp_path / "flown_bench"
    (tmp_path / "short.csv").write_text("names\n1,2\n")
    for words, said in (
        (["none.csv"], "none.csv: No such file"),
        (["short.csv"], "short.csv: line 2: "),
        ([], "usage"),
    ):
        done = subprocess.run([program, *words], cwd=tmp_path, check=False, capture_output=True, text=True)
        assert done.returncode == 2
        assert said in done.stderr


@pytest.mark.promise("export-5")
def test_vectors_keep_all_their_digits(shipped):
    of, vectors = choice.flight_controller(shipped), choice.vectors(shipped, 5)
    lines = c_code.vectors_text(of, vectors).splitlines()
    assert lines[0].split(",") == [
        *(f"{name}_{i}" for name in ("optical_error_rad", "reference_rad") for i in range(2)),
        "command_v_0",
        "command_v_1",
    ]
    numbers = np.array([[float(x) for x in line.split(",")] for line in lines[1:]])
    assert_array_equal(numbers, np.hstack([vectors.inputs, vectors.commands]))


# ------------------------------------------------------------------------------------------------ refusals, literals


def code_of(of, name="flown", precision="double", bound=None):
    return c_code.flight_code(of, sections(of), name, precision, bound)


def test_what_cannot_become_code_is_refused(shipped):
    of = choice.flight_controller(shipped)
    assert code_of(of)
    cases = (
        ({"name": "2nd"}, "2nd"),
        ({"precision": "single"}, "in single precision: no bound on its rounding is given"),
        ({"of": replace(of, minimum_v=1.0, maximum_v=0.5)}, "no command lies between its limits of 1 V and 0.5 V"),
        ({"of": replace(of, minimum_v=0.0001, maximum_v=0.0002)}, "at a resolution of 0.000305 V; see the mission's"),
        (
            {"of": replace(of, bias_v=1e39), "precision": "single", "bound": GENEROUS},
            "1e+39 is beyond single",
        ),
        ({"of": replace(of, bias_v=nan)}, "a number of the exported code is nan"),
    )
    for given, words in cases:
        with pytest.raises(ExportError, match=re.escape(words)):
            code_of(**{"of": of, **given})


@pytest.mark.promise("export-6")
def test_limits_are_never_rounded_outwards(shipped, tmp_path):
    """6.1 is no number of single precision; the nearest one is larger."""
    of = replace(choice.flight_controller(shipped), minimum_v=-6.1, maximum_v=6.1, resolution_v=0.0)
    assert float(np.float32(6.1)) < 6.1
    of = replace(of, maximum_v=6.3, minimum_v=-6.3)
    assert float(np.float32(6.3)) > 6.3
    found, _ = Code(tmp_path, of, "single").run(np.full((400, 4), 0.09) * np.sign(np.arange(400) - 200)[:, None])
    assert_array_equal([np.max(found), -np.min(found)], float(np.nextafter(np.float32(6.3), np.float32(0))))


@pytest.mark.parametrize(
    ("x", "double", "single"),
    [
        (0.1, "0.1", "0.1f"),
        (1.0, "1.0", "1.0f"),
        (-1e22, "-1e+22", "-1e+22f"),
        (inf, "1.7976931348623157e+308", "3.4028235e+38f"),
        (1e-40, "1e-40", "0.0f"),
        (5e-324, "0.0", "0.0f"),
        (-inf, "-1.7976931348623157e+308", "-3.4028235e+38f"),
        (3.4028234663852886e38, "3.4028234663852886e+38", "3.4028235e+38f"),
        (2.0**-126, "1.1754943508222875e-38", "1.1754944e-38f"),
        (-(2.0**-127), "-5.877471754111438e-39", "0.0f"),
        (2.0**-1022, "2.2250738585072014e-308", "0.0f"),
        (1 / 3, "0.3333333333333333", "0.33333334f"),
    ],
)
def test_literals_read_back_to_the_same_number(x, double, single):
    assert (real(x), real(x, "single")) == (double, single)


def test_tables_stand_row_by_row():
    assert table([[1, 2], [3, 4e30]]) == "{\n    {1.0, 2.0},\n    {3.0, 4e+30},\n}"
    assert terms([(0, 0, 1.0), (0, 2, 0.5), (1, 1, -1.0)]) == "{0, 0, 1.0}, {0, 2, 0.5},\n    {1, 1, -1.0},"
    assert max(map(len, terms([(0, j, 1 / 3) for j in range(20)]).splitlines())) <= 116


@pytest.mark.promise("export-11")
def test_a_counter_stops_at_its_largest_value(tmp_path):
    of = choice.flight_controller(designs.without_converter("PI"))
    Code(tmp_path, of)
    text = """#include "flown.c"
#include <stdio.h>
int main(void)
{
    uint32_t counter = UINT32_MAX - 1U;
    flown_count(&counter);
    printf("%u ", UINT32_MAX - counter);
    flown_count(&counter);
    flown_count(&counter);
    printf("%u\\n", UINT32_MAX - counter);
    return 0;
}
"""
    (tmp_path / "counted.c").write_text(text)
    subprocess.run(["gcc", "-std=c99", "-o", "counted", "counted.c", "-lm"], cwd=tmp_path, check=True)
    done = subprocess.run([tmp_path / "counted"], check=True, capture_output=True, text=True)
    assert done.stdout == "0 0\n"


@pytest.mark.promise("export-12")
def test_with_an_error_of_0_integrators_stay_and_a_rejected_reading_goes_on_driving_them(tmp_path):
    of = choice.flight_controller(designs.without_converter("PI"))
    code, width = Code(tmp_path, of), sum(each.size for each in of.inputs)
    begun, opened, rejected = np.zeros((500, width)), np.zeros((2000, width)), np.zeros((500, width))
    begun[:, :2], rejected[:, :2] = 1e-6, nan
    state = code.begin()
    driven = code.replay(begun, state)[-1]
    assert np.all(driven > 0.0)  # the angle rises with the command
    still = code.replay(opened, state)
    assert np.all(np.abs(still[-1]) > 1e-3)
    assert_allclose(still[-1000:], np.broadcast_to(still[-1], (1000, 2)), rtol=1e-9)
    closed = code.replay(np.zeros((1, width)), state)
    assert_allclose(closed[0], still[-1], rtol=1e-9)  # no jump
    other = code.begin()
    assert_array_equal(code.replay(begun, other)[-1], driven)
    gone_on = code.replay(rejected, other)
    wanted = code.replay(np.concatenate([begun, begun]))[500:]
    assert_array_equal(gone_on, wanted)
    assert np.all(np.abs(gone_on[-1]) > 1.5 * np.abs(driven))


def held_to(low, high, step, precision="double"):
    of = SimpleNamespace(name="c", minimum_v=low, maximum_v=high, resolution_v=step)
    found = c_code._limits(of, precision)
    return found.minimum, found.maximum, found.resolution, found.lowest, found.highest, found.rest


@pytest.mark.parametrize(
    ("low", "high", "step", "lowest", "highest", "rest"),
    [
        (-1.0, 2.0, 0.0, -1.0, 2.0, 0.0),
        (-1.0, 2.0, 0.75, -0.75, 1.5, 0.0),
        (-1.5, 1.5, 0.75, -1.5, 1.5, 0.0),
        (-1.4999999, 1.4999999, 0.75, -1.4999999, 1.4999999, 0.0),  # a millionth of a step beyond is rounding
        (-inf, 2.0, 0.75, -inf, 1.5, 0.0),
        (-1.0, inf, 0.75, -0.75, inf, 0.0),
        (-inf, inf, 0.75, -inf, inf, 0.0),
        (0.5, 1.5, 0.75, 0.75, 1.5, 0.75),
        (-1.5, -0.5, 0.75, -1.5, -0.75, -0.75),
        (0.75, 0.75, 0.75, 0.75, 0.75, 0.75),
        (3.0, 3.0, 0.0, 3.0, 3.0, 3.0),
    ],
)
def test_the_outermost_commands_are_counts_of_the_converter_within_the_limits(low, high, step, lowest, highest, rest):
    assert held_to(low, high, step) == (low, high, step, lowest, highest, rest)


@pytest.mark.parametrize(
    ("low", "high", "step", "at"), [(0.1, 0.7, 0.75, " at a resolution of 0.75 V"), (2.0, 1.0, 0.0, "")]
)
def test_limits_between_which_no_command_lies_are_told_with_the_resolution_where_there_is_one(low, high, step, at):
    words = f"controller 'c': no command lies between its limits of {low:g} V and {high:g} V{at}; see the mission's"
    with pytest.raises(ExportError, match=f"^{re.escape(words)}"):
        held_to(low, high, step)


def test_limits_in_single_precision_are_never_outside_of_the_controllers():
    assert held_to(-0.5, 0.5, 0.0, "single")[:2] == (-0.5, 0.5)
    for size in (0.1, 0.3, 0.7, 1.1):
        least, most = held_to(-size, size, 0.0, "single")[:2]
        assert -size <= least < -size * (1.0 - 2e-7) and size * (1.0 - 2e-7) < most <= size
        assert float(np.float32(most)) == most == -least
    assert held_to(-inf, inf, 0.0, "single")[:2] == (-inf, inf)


# ------------------------------------------------------------------------------------------- words and places, whole
def made_controller(**changes):
    """A controller of two actuators and two signals, with limits, bias and margins unlike each other."""
    given = {
        "name": "PI \u00fcber alles",
        "origin": Origin("a mission", "0123456789abcdef" * 4, "a mirror"),
        "period_s": 4e-4,
        "inputs": (Signal("tip_rad_s", 2, "rad/s", "a rate", 5.0), Signal("gauge_rad", 1, "rad", "a gauge", 0.1)),
        "actuators": 2,
        "system": lti.StateSpace(np.diag([0.5, 0.25]), np.ones((2, 3)), np.ones((2, 2)), np.zeros((2, 3))),
        "anti_windup": np.zeros((2, 2)),
        "inverse": None,
        "minimum_v": -4.5,
        "maximum_v": 7.25,
        "resolution_v": 0.0025,
        "bias_v": 6.125,
        "margins": (("modulus margin", 0.5625, ""), ("gain margin", 7.5, "dB"), ("delay margin", 3.75e-4, "s")),
    }
    return FlightController(**given | changes)


def made_export(**changes):
    of = made_controller()
    given = {
        "folder": None,
        "name": "pi_code",
        "precision": "single",
        "controller": of,
        "left": Outlook(1.5e-6, 2.25e-6),
        "form": SimpleNamespace(order=2, form="modal"),
        "cost": Operations(multiplications=12, additions=9, divisions=1),
        "bound": RoundingBound(3e-6, 900, 1e-10, "It stays within 3e-06 V."),
        "fixed": None,
        "samples": 900,
        "bench": BenchResult(900, 2.5e-7, 3.5, 4e-6, 11, 12, 13, 14, 250.4, 120.6, 20.0, 2.5),
        "stack": StackUse(192, ("exp", "pow")),
    }
    return SimpleNamespace(**given | changes)


def test_the_report_of_an_export_has_each_number_on_its_own_line():
    assert flight_write.report_text(made_export()).split("\n") == [
        "pi_code: PI über alles in single precision",
        "  from          a mission, sha256 0123456789abcdef",
        "  mirror        a mirror",
        "  controller    PI über alles, 2.5 kHz, 2 states in modal form",
        "  reads         tip_rad_s[2], gauge_rad[1]",
        "  commands      2 x -4.5 V to 7.25 V from the bias of 6.125 V, in counts of 2.5 mV",
        "  margins       modulus margin 0.562, gain margin 7.5 dB, delay margin 375 µs",
        "  leaves        1.5 µrad rms an axis in linear theory, 2.25 µrad rms an axis simulated",
        "  a step costs  12 multiplications, 9 additions, 1 division",
        ("  stack         192 bytes at most, from this machine's compiler, and what the C library takes in exp, pow"),
        "  single        It stays within 3e-06 V.",
        "  compiled, run 900 samples of the loop: at most 250 nV off the kernel (allowed: 4 µV)",
        "  counters      11 saturated, 12 rate-clamped, 13 rejected, 14 faults",
        "  time a step   250 ns at worst, 121 ns in the median, on this machine",
        "  cycles        626 at worst, 302 in the median, of this machine's counter at 2.5 GHz",
    ]
    bare = made_export(precision="double", left=None, bound=None, stack=None, bench=None)
    bare.controller = made_controller(resolution_v=0.0, minimum_v=-inf, maximum_v=inf)
    assert flight_write.report_text(bare).split("\n") == [
        "pi_code: PI über alles in double precision",
        "  from          a mission, sha256 0123456789abcdef",
        "  mirror        a mirror",
        "  controller    PI über alles, 2.5 kHz, 2 states in modal form",
        "  reads         tip_rad_s[2], gauge_rad[1]",
        "  commands      2 x -inf V to inf V from the bias of 6.125 V",
        "  margins       modulus margin 0.562, gain margin 7.5 dB, delay margin 375 µs",
        "  a step costs  12 multiplications, 9 additions, 1 division",
        ("  not compiled  there is no C compiler here (cc, gcc, clang); make in the folder builds the bench"),
    ]
    still = replace(made_export().bench, cycles_per_ns=0.0)
    assert "cycles" not in flight_write.report_text(made_export(bench=still))


def test_the_data_of_an_export_have_each_number_under_its_own_name():
    assert flight_write.export_data(made_export()) == {
        "name": "pi_code",
        "controller": "PI über alles",
        "precision": "single",
        "mission_sha256": "0123456789abcdef0123456789abcdef0123456789abcdef0123456789abcdef",
        "period_s": 0.0004,
        "states": 2,
        "form": "modal",
        "inputs": [
            {"name": "tip_rad_s", "size": 2, "unit": "rad/s", "limit": 5.0},
            {"name": "gauge_rad", "size": 1, "unit": "rad", "limit": 0.1},
        ],
        "limits_v": [-4.5, 7.25],
        "bias_v": 6.125,
        "margins": {
            "modulus margin": {"value": 0.5625, "unit": ""},
            "gain margin": {"value": 7.5, "unit": "dB"},
            "delay margin": {"value": 0.000375, "unit": "s"},
        },
        "residual": {"linear_rms_rad_per_axis": 1.5e-06, "simulated_rms_rad_per_axis": 2.25e-06},
        "operations": {
            "multiplications": 12,
            "additions": 9,
            "divisions": 1,
            "comparisons": 0,
            "exponentials": 0,
            "logarithms": 0,
            "powers": 0,
            "roundings": 0,
        },
        "stack": {
            "most_bytes": 192,
            "library": (
                "exp",
                "pow",
            ),
        },
        "bound": {"command_v": 3e-06, "samples": 900, "per_sample_v": 1e-10, "words": "It stays within 3e-06 V."},
        "bench": {
            "samples": 900,
            "largest_difference_v": 2.5e-07,
            "peak_command_v": 3.5,
            "bound_v": 4e-06,
            "saturated": 11,
            "rate_clamped": 12,
            "rejected": 13,
            "faults": 14,
            "worst_step_ns": 250.4,
            "median_step_ns": 120.6,
            "clock_ns": 20.0,
            "cycles_per_ns": 2.5,
        },
    }
    bare = flight_write.export_data(made_export(left=None, bound=None, stack=None, bench=None))
    assert {key: value for key, value in bare.items() if value is None} == {
        "residual": None,
        "stack": None,
        "bound": None,
        "bench": None,
    }


def test_inputs_have_their_places_names_and_units_in_constants():
    found = c_code._readings(made_controller().inputs)
    assert [[each[key] for key in ("name", "first", "size", "NAME", "UNIT")] for each in found] == [
        ["tip_rad_s", 0, 2, "TIP", "RAD_S"],
        ["gauge_rad", 2, 1, "GAUGE", "RAD"],
    ]
    assert c_code._places(["a", "b", "c"], [2, 1, 3]) == "a 0 to 1, b 2, c 3 to 5"
    assert c_code._places([], []) == ""


def test_recorded_numbers_stand_below_the_names_of_three_readings_and_two_commands():
    v = SimpleNamespace(
        inputs=np.array([[0.1, 2.0, -3e-300], [1 / 3, 0.0, 5.0]]), commands=np.array([[1.0, -2.5], [7.0, 8.0]])
    )
    assert c_code.vectors_text(made_controller(), v).split("\n") == [
        "tip_rad_s_0,tip_rad_s_1,gauge_rad_0,command_v_0,command_v_1",
        "0.10000000000000001,2,-3.0000000000000002e-300,1,-2.5",
        "0.33333333333333331,0,5,7,8",
        "",
    ]


def test_signals_stand_one_behind_the_other_and_those_that_nothing_reads_are_left_out():
    of = made_controller()
    assert choice.columns(of.inputs) == {"tip_rad_s": slice(0, 2), "gauge_rad": slice(2, 3)}
    B, D = np.zeros((2, 3)), np.zeros((2, 3))
    D[1, 2] = 4.0
    of = replace(of, system=lti.StateSpace(of.system.A, B, of.system.C, D))
    made = choice.trimmed(of)
    assert [each.name for each in made.inputs] == ["gauge_rad"]
    assert (made.system.B.tolist(), made.system.D.tolist()) == ([[0.0], [0.0]], [[0.0], [4.0]])


def test_margins_of_one_axis_and_of_all_have_their_units():
    one = SimpleNamespace(modulus=0.5, gain_up=10.0, phase_rad=pi / 6.0, delay_s=3e-4)
    assert [(name, round(value, 9), unit) for name, value, unit in choice._margins(one)] == [
        ("modulus margin", 0.5, ""),
        ("gain margin", 20.0, "dB"),
        ("phase margin", 30.0, "deg"),
        ("delay margin", 3e-4, "s"),
    ]
    several = SimpleNamespace(modulus=0.4, disk=SimpleNamespace(disk=0.7), bandwidth_hz=90.0)
    assert choice._margins_of_all(several) == (
        ("modulus margin of all axes", 0.4, ""),
        ("disk margin of all axes", 0.7, ""),
        ("bandwidth", 90.0, "Hz"),
    )


def test_a_controller_that_leaves_too_much_is_refused_with_both_figures_unless_accepted():
    left = Outlook(1e-6, 4.5e-6)
    chosen = SimpleNamespace(
        left=left, controller=SimpleNamespace(name="quick PI"), source=SimpleNamespace(path="m.toml")
    )
    with pytest.raises(ExportError) as error:
        choice.promised(chosen)
    assert str(error.value) == (
        "m.toml: quick PI leaves 4.5 µrad rms an axis on the mission's mirror, simulated "
        "with its hysteresis: 4.5 times the 1 µrad rms an axis of linear theory, where "
        "1.5 times is the most. Choose another controller by the simulated figures of "
        "microrad design, or write this one all the same with --accept."
    )
    assert choice.promised(chosen, accept=True) is left


@pytest.mark.parametrize(
    ("text", "made"),
    [
        ("a */ b /* c", "a * / b / * c"),
        ("a **// b", "a ** // b"),
        ("??/ and \\ end", "? ?/ and / end"),
        ("a ???/ b ????", "a ? ? ?/ b ? ? ? ?"),
        ("a\nb\tc\x00d", "a b c d"),
        ("", ""),
        ("w " * 70, f"{'w ' * 55}w\n * {'w ' * 13}w"),
    ],
)
def test_a_comment_of_c_ends_nowhere_within(text, made):
    found = comment(text, " * ")
    assert "*/" not in found.replace("\n * ", "") and "/*" not in found and "??" not in found and "\\" not in found
    assert found == made


@pytest.mark.parametrize(
    ("x", "precision", "said"),
    [
        (nan, "double", "a number of the exported code is nan: no literal of C stands for it; look for its origin"),
        (1e39, "single", "1e+39 is beyond single precision, which ends at 3.403e+38: export double precision"),
    ],
)
def test_a_number_without_a_literal_is_refused_in_all_its_words(x, precision, said):
    with pytest.raises(ExportError, match=f"^{re.escape(said)}$"):
        real(x, precision)


def test_terms_begin_a_line_for_each_row_and_where_one_is_full():
    many = [(3, j, 0.125) for j in range(9)] + [(4, 0, -2.0)]
    assert terms(many, "single").split("\n") == [
        (
            "{3, 0, 0.125f}, {3, 1, 0.125f}, {3, 2, 0.125f}, {3, 3, 0.125f}, {3, 4, 0.125f}, "
            "{3, 5, 0.125f}, {3, 6, 0.125f},"
        ),
        "    {3, 7, 0.125f}, {3, 8, 0.125f},",
        "    {4, 0, -2.0f},",
    ]
    assert terms([]) == ""


# ------------------------------------------------------------------------------------------ from a mission to a choice
MISSION = SimpleNamespace(name="a mission", fine_pointing="fine", mirror=SimpleNamespace(name="one", bias_v=6.25))
MISSION_FILE = SimpleNamespace(path="m.toml", mission=MISSION, sha256="5ha")
ORIGIN = Origin("a mission", "5ha", "one")


def several(*biases, name="plate"):
    """A mirror of several axes whose actuators rest at these biases."""
    of = SimpleNamespace(name=name, axes=1)
    return SimpleNamespace(mirror=of, actuators=[SimpleNamespace(bias_v=bias) for bias in biases])


@pytest.fixture
def chosen_of(monkeypatch):
    """What `choice` makes of a mission by its parts, all of them said as they were asked for."""
    asked = []
    told = lambda name: lambda *given, **more: asked.append((name, *given, *more.items())) or f"{name} of {given[0]}"  # noqa: E731
    monkeypatch.setattr(choice.controller_study, "offered", lambda table, of: ("PI", "LQG"))
    monkeypatch.setattr(choice.mirror, "of", lambda m: f"mirrors of {m.name}")
    monkeypatch.setattr(choice, "tracking_light_w", lambda file: 2.5e-9)
    monkeypatch.setattr(choice, "arrival_of", lambda file: "arrival")
    monkeypatch.setattr(choice.controller_study, "scene", told("scene"))
    monkeypatch.setattr(choice.coupled_study, "scene", told("coupled scene"))
    monkeypatch.setattr(choice.paper_cases, "of", told("cases"))
    monkeypatch.setattr(choice, "_paper_loop", lambda of, cases, name: ("paper loop", of, cases, name))
    design = SimpleNamespace(tuned="tuned", controller="controller")
    monkeypatch.setattr(
        choice.controller_study,
        "design_and_promise",
        lambda *given, only: asked.append(("design", *given, only)) or ((design, "left"),),
    )
    return asked


def test_a_controller_is_chosen_among_those_of_the_study_and_the_two_of_the_paper(chosen_of):
    assert choice.names("fine", MISSION.mirror) == ("PI", "LQG", choice.PID, choice.PID_WITH_INVERSE)
    assert choice.names(None, MISSION.mirror) == (choice.PID, choice.PID_WITH_INVERSE)
    own = choice.source(MISSION_FILE)
    assert (own.path, own.origin, own.mirror, own.bias_v) == ("m.toml", ORIGIN, MISSION.mirror, 6.25)
    found = choice.choose(MISSION_FILE, "LQG", "told")
    assert (found.source, found.scene, found.tuned, found.controller, found.left) == (
        *(own, f"scene of {MISSION_FILE}", "tuned", "controller", "left"),
    )
    assert chosen_of == [
        ("scene", MISSION_FILE, "mirrors of a mission", 2.5e-9, "arrival"),
        ("design", f"scene of {MISSION_FILE}", "told", ("LQG",)),
    ]
    for name in (choice.PID, choice.PID_WITH_INVERSE):
        assert choice.choose(MISSION_FILE, name) == ("paper loop", own, "cases of " + str(MISSION), name)
    assert chosen_of[2:] == [("cases", MISSION, "mirrors of a mission")] * 2


@pytest.mark.parametrize("name", ["P", "", "lqg"])
def test_a_controller_that_a_mission_has_not_is_refused_with_those_that_it_has(chosen_of, name):
    with pytest.raises(ExportError) as told:
        choice.choose(MISSION_FILE, name)
    has = f"PI; LQG; {choice.PID}; {choice.PID_WITH_INVERSE}"
    assert str(told.value) == f"m.toml has no controller {name!r}; it has: {has}"


@pytest.mark.parametrize("call", ["choose", "choose_coupled", "plant_unit", "plant_unit of several"])
def test_what_cannot_be_built_is_told_with_the_mission(chosen_of, monkeypatch, call):
    def broken(*given, **more):
        raise ValueError("no such loop")

    for place in (choice.controller_study, choice.coupled_study):
        monkeypatch.setattr(place, "scene", broken)
    calls = {
        "choose": lambda: choice.choose(MISSION_FILE, "PI"),
        "choose_coupled": lambda: choice.choose_coupled(MISSION_FILE, several(2.0, 2.0), "PI"),
        "plant_unit": lambda: choice.plant_unit(MISSION_FILE, "fine_pointing"),
        "plant_unit of several": lambda: choice.plant_unit(MISSION_FILE, "fine_pointing", several(2.0)),
    }
    with pytest.raises(ExportError, match=r"^m\.toml: no such loop$"):
        calls[call]()


@pytest.mark.parametrize(
    ("biases", "told"),
    [((2.5, 2.5, 2.5), None), ((6.0, 2.5, 6.0), "2.5 V, 6 V"), ((-1.0, 0.0, 1e-3), "-1 V, 0 V, 0.001 V")],
)
def test_actuators_of_several_axes_count_from_one_bias(biases, told):
    if told is None:
        found = choice.source(MISSION_FILE, given := several(*biases))
        assert (found.bias_v, found.mirror, found.origin) == (2.5, given, replace(ORIGIN, mirror="plate"))
        return
    with pytest.raises(ExportError) as error:
        choice.source(MISSION_FILE, several(*biases))
    assert str(error.value) == (
        f"the actuators of 'plate' rest at {told}, and exported code counts all commands from one bias: give all "
        "actuators the same, in the mirror file and in the amplifier"
    )


@pytest.mark.parametrize(
    ("loop", "fine_pointing", "given", "told"),
    [
        (
            "fine",
            "fine",
            None,
            "m.toml has no loop 'fine': one of fine_pointing, control that is a table of the mission",
        ),
        (
            *("fine_pointing", None, None),
            "m.toml has no loop 'fine_pointing': one of fine_pointing, control that is a table of the mission",
        ),
        (
            *("control", "fine", several(2.0)),
            "the loop 'control' is of one axis, and 'plate' is a mirror of several: take fine_pointing",
        ),
    ],
)
def test_a_loop_that_a_plant_cannot_stand_in_is_refused(loop, fine_pointing, given, told):
    file = SimpleNamespace(path="m.toml", mission=SimpleNamespace(fine_pointing=fine_pointing))
    with pytest.raises(ExportError) as error:
        choice.plant_unit(file, loop, given)
    assert str(error.value) == told


@pytest.mark.parametrize(
    ("loop", "given", "first"),
    [("fine_pointing", None, "one"), ("fine_pointing", several(3.5, 3.5), "plate"), ("control", None, "one")],
)
def test_a_plant_is_that_of_its_loop_with_its_own_mirror_and_bias(chosen_of, monkeypatch, loop, given, first):
    def parts(name):
        mirror = SimpleNamespace(name=name, axes=3)
        return SimpleNamespace(
            mirror=mirror, optics=f"{name}'s optics", drive=f"{name}'s drive", timing=f"{name}'s time"
        )

    for place, name in ((choice.controller_study, "axis"), (choice.coupled_study, "axes")):
        monkeypatch.setattr(place, "scene", lambda *of, name=name: SimpleNamespace(loop=parts(name)))
    paper = parts("paper")
    setup = SimpleNamespace(drive=paper.drive, timing=paper.timing)
    one = SimpleNamespace(source=choice.source(MISSION_FILE), mirror=paper.mirror, setup=setup)
    monkeypatch.setattr(choice, "_paper_loop", lambda of, cases, name: one)
    monkeypatch.setattr(choice, "_plant_unit", lambda *of: of)
    source, mirror, optics, drive, timing = choice.plant_unit(MISSION_FILE, loop, given)
    name = "paper" if loop == "control" else "axis" if given is None else "axes"
    assert (source.origin.mirror, source.bias_v) == (first, 6.25 if given is None else 3.5)
    assert (mirror.name, drive, timing) == (name, f"{name}'s drive", f"{name}'s time")
    assert optics == f"{name}'s optics" if name != "paper" else optics.tolist() == np.eye(3).tolist()


@pytest.mark.parametrize(
    ("quantities", "unit"),
    [(None, "rad"), (("angle",), "rad"), (("displacement",) * 2, "m"), (("angle", "displacement"), "")],
)
def test_a_plant_unit_has_steps_of_its_amplifier_and_the_unit_of_its_outputs(monkeypatch, quantities, unit):
    given = MISSION.mirror
    if quantities is not None:
        given = object.__new__(choice.coupled.CoupledMirror)
        for name, value in {
            "outputs": tuple(SimpleNamespace(quantity=each) for each in quantities),
            "mirror": SimpleNamespace(name="plate"),
        }.items():
            object.__setattr__(given, name, value)
    monkeypatch.setattr(choice.model, "discretise", lambda of, step_s: ("discrete", of, step_s))
    monkeypatch.setattr(choice.control, "amplifier_factor", lambda drive, step_s: 1000.0 * step_s)
    drive = SimpleNamespace(bandwidth_hz=750.0, slew_v_s=40.0)
    source = choice.Source("m.toml", ORIGIN, given, 6.25)
    make = lambda: choice._plant_unit(source, "a mirror", "optics", drive, SimpleNamespace(step_s=2e-4))  # noqa: E731
    if not unit:
        with pytest.raises(
            ExportError, match=r"^the outputs of 'plate' are displacements and angles, and a unit shows"
        ):
            make()
        return
    found = make()
    assert (found.origin, found.plant, found.optics) == (ORIGIN, ("discrete", "a mirror", 2e-4), "optics")
    assert (found.bandwidth_hz, found.follow, found.slew_step_v) == pytest.approx((750.0, 0.2, 0.008))
    assert (found.bias_v, found.output_unit, found.element_unit) == (6.25, unit, "rad" if quantities is None else "V")


@pytest.mark.parametrize("name", [choice.PID, choice.PID_WITH_INVERSE])
def test_the_controller_of_the_paper_reads_and_is_given_angles_and_has_its_limits(monkeypatch, name):
    s = lti.StateSpace(np.diag([0.5, 0.25]), np.array([[1.0], [3.0]]), np.array([[2.0, 5.0]]), np.array([[7.0]]))
    drive = SimpleNamespace(minimum_v=-4.5, maximum_v=7.25, drive_resolution_v=0.0025)
    setup = SimpleNamespace(controller=s, timing=SimpleNamespace(period_s=4e-4), drive=drive)
    monkeypatch.setattr(choice, "inverse_law", lambda *of, by_difference: ("law", *of, by_difference))
    monkeypatch.setattr(choice.control, "anti_windup", lambda of: ("windup", of))
    monkeypatch.setattr(choice.sine_run, "margins", lambda mirror, of: ("margins", mirror, of))
    monkeypatch.setattr(choice, "_margins", lambda of: of)
    mirror = SimpleNamespace(axes=1, actuators=1)
    source = choice.Source("m.toml", ORIGIN, None, 6.125)
    found = choice._paper_controller(choice.PaperLoopChoice(source, "scenario", name, mirror, setup, "inverse"))
    given = [(each.name, each.size, each.unit, each.meaning, each.limit) for each in found.inputs]
    assert given == [
        ("reading_rad", 1, "rad", "line of sight as the mirror's sensor reads it", 0.1),
        ("reference_rad", 1, "rad", "wanted line of sight", 0.1),
    ]
    inverse = name == choice.PID_WITH_INVERSE
    assert (found.name, found.origin, found.period_s, found.actuators) == (name, ORIGIN, 4e-4, 1)
    assert found.system.B.tolist() == [[-1.0, 1.0], [-3.0, 3.0]] and found.system.A is s.A
    assert found.system.C.tolist() == [[2.0, 5.0]] + [[0.0, 0.0]] * inverse
    assert found.system.D.tolist() == [[-7.0, 7.0]] + [[0.0, 1.0]] * inverse
    assert found.inverse == (("law", "inverse", 4e-4, True) if inverse else None)
    assert (found.anti_windup, found.margins) == (("windup", s), ("margins", mirror, setup))
    assert (found.minimum_v, found.maximum_v, found.resolution_v, found.bias_v) == (-4.5, 7.25, 0.0025, 6.125)
    assert (found.forward, found.adaptation) == (None, None)


@pytest.mark.parametrize("resolution", [0.0, 0.5])
def test_a_run_of_the_paper_follows_its_fastest_sine_and_reads_in_steps_of_its_sensor(monkeypatch, resolution):
    asked = []
    output = np.array([[0.2], [0.3], [-0.75], [1.3]])
    counts = SimpleNamespace(saturated=3, inverse_clamped=5)
    trace = SimpleNamespace(output_rad=output, command_v=10.0 * output, counts=counts)
    monkeypatch.setattr(choice.sine_run, "track", lambda *given: asked.append(given) or trace)
    scenario = SimpleNamespace(amplitude_rad=2.0, inverse_frequencies_hz=(1.0, 4.0, 2.5))
    setup = SimpleNamespace(
        timing=SimpleNamespace(period_s=0.03125), drive=SimpleNamespace(sensor_resolution_rad=resolution)
    )
    of = choice.PaperLoopChoice(None, scenario, "PID", "mirror", setup, "inverse")
    found = choice._paper_vectors(of, 4)
    ((name, mirror, given, inverse, reference, kept),) = asked
    assert (name, mirror, given, inverse, kept) == ("PID", "mirror", setup, "inverse", slice(0, 4))
    assert_allclose(reference[:, 0], 2.0 * np.sin(2.0 * pi * 4.0 * 0.03125 * np.arange(4.0)), atol=1e-12)
    assert found.inputs[:, 0].tolist() == ([0.2, 0.3, -0.75, 1.3] if resolution == 0.0 else [0.0, 0.5, -0.5, 1.5])
    assert_array_equal(found.inputs[:, 1:], reference)
    assert (found.commands.tolist(), found.saturated, found.rate_clamped) == ((10.0 * output).tolist(), 3, 5)


@pytest.mark.parametrize(("times", "told"), [(1.503, "1.503"), (1.50004, "1.501"), (1.6, "1.6"), (12.34567, "12.35")])
def test_a_ratio_beyond_the_most_is_not_told_as_the_most(times, told):
    chosen = SimpleNamespace(
        left=Outlook(1e-6, times * 1e-6), controller=SimpleNamespace(name="PI"), source=SimpleNamespace(path="m.toml")
    )
    with pytest.raises(
        ExportError, match=f": {told} times the 1 µrad rms an axis of linear theory, where 1.5 times is"
    ):
        choice.promised(chosen)


# ------------------------------------------------------------------------------------------ parts of a loop, unlike all
@pytest.mark.parametrize(
    ("raised", "said"),
    [
        (ExportError("controller 'PI': A is nan"), "controller 'PI': A is nan"),
        (ValueError("the loop is unstable"), "m.toml: the loop is unstable"),
    ],
)
def test_a_controller_that_cannot_fly_is_refused_once_with_its_mission_or_its_name(monkeypatch, raised, said):
    def broken(of):
        raise raised

    monkeypatch.setattr(choice, "_whole_controller", lambda chosen: "whole")
    monkeypatch.setattr(choice, "trimmed", lambda of: of)
    monkeypatch.setattr(choice, "minimal", broken)
    with pytest.raises(ExportError) as told:
        choice.flight_controller(SimpleNamespace(source=SimpleNamespace(path="m.toml")))
    assert str(told.value) == said


@pytest.mark.parametrize("gauge", [None, SimpleNamespace(resolution_rad=7e-9, noise_rad=1.0)])
def test_a_loop_unit_has_the_steps_and_resolutions_of_its_own_sensors(monkeypatch, gauge):
    optical = SimpleNamespace(delay_steps=5, every=3, field_of_view_rad=4e-3, resolution_rad=2e-8)
    timing = SimpleNamespace(steps_per_sample=11, delay_steps=2)
    loop = SimpleNamespace(mirror="mirror", optics="optics", drive="drive", timing=timing, optical=optical, gauge=gauge)
    chosen = SimpleNamespace(source="source", scene=SimpleNamespace(loop=loop))
    monkeypatch.setattr(choice, "flight_controller", lambda of: ("controller of", of))
    monkeypatch.setattr(choice, "_plant_unit", lambda *of: of)
    unit = choice.loop_unit(chosen)
    assert unit.plant == ("source", "mirror", "optics", "drive", timing)
    assert unit.controller == ("controller of", chosen)
    assert (unit.steps_per_sample, unit.delay_steps) == (11, 2)
    assert (unit.optical_delay_steps, unit.optical_every, unit.field_of_view_rad) == (5, 3, 4e-3)
    assert (unit.optical_resolution_rad, unit.gauge_resolution_rad) == (2e-8, 7e-9 if gauge else 0.0)


def test_a_loop_unit_of_the_paper_reads_its_sensor_at_each_sample_and_has_no_gauge(monkeypatch):
    timing = SimpleNamespace(steps_per_sample=13, delay_steps=4)
    setup = SimpleNamespace(drive=SimpleNamespace(sensor_resolution_rad=3e-8), timing=timing)
    chosen = choice.PaperLoopChoice("source", "scenario", "PID", SimpleNamespace(axes=2), setup, "inverse")
    monkeypatch.setattr(choice, "flight_controller", lambda of: "controller")
    monkeypatch.setattr(choice, "_plant_unit", lambda *of: of)
    unit = choice.loop_unit(chosen)
    source, mirror_, optics, drive, time = unit.plant
    assert (source, mirror_, drive, time) == ("source", chosen.mirror, setup.drive, timing)
    assert optics.tolist() == [[1.0, 0.0], [0.0, 1.0]]
    assert (unit.steps_per_sample, unit.delay_steps, unit.optical_delay_steps, unit.optical_every) == (13, 4, 0, 1)
    assert (unit.field_of_view_rad, unit.optical_resolution_rad, unit.gauge_resolution_rad) == (inf, 3e-8, 0.0)


def test_recorded_vectors_are_of_the_missions_seed_and_keep_the_readings_that_are_looked_at(monkeypatch):
    asked, counts = [], np.arange(100.0, 120.0)
    inputs, commands = np.arange(12.0).reshape(2, 6), np.array([[1.0], [2.0]])

    def replayed(*given):
        asked.append(given)
        return SimpleNamespace(inputs=inputs, commands=commands, counts=counts)

    monkeypatch.setattr(choice, "replay", replayed)
    monkeypatch.setattr(choice, "_whole_controller", lambda chosen: "whole")
    monkeypatch.setattr(choice, "_looked_at", lambda of: {"error": slice(0, 1), "reference": slice(3, 5)})
    scene = SimpleNamespace(loop="loop", table=SimpleNamespace(seed=41))
    found = choice.vectors(SimpleNamespace(scene=scene, controller="controller"), 2)
    assert asked == [("loop", "controller", 2, 41)]
    assert found.inputs.tolist() == [[0.0, 3.0, 4.0], [6.0, 9.0, 10.0]] and found.commands is commands
    assert found.saturated == int(counts[kernels.COUNT_SATURATED])
    assert found.rate_clamped == int(counts[kernels.COUNT_INVERSE_CLAMPED])


@pytest.mark.parametrize(
    ("value", "unit", "said"),
    [
        (1234.5, "Hz", "1.23 kHz"),
        (0.0004567, "s", "457 µs"),
        (inf, "dB", "inf dB"),
        (12.345, "deg", "12.3 deg"),
        (0.56789, "", "0.568"),
    ],
)
def test_margins_of_a_report_have_three_digits_in_their_own_unit(value, unit, said):
    of = made_export(controller=made_controller(margins=(("first", 2.0, ""), ("last", value, unit))))
    (line,) = (each for each in flight_write.report_text(of).splitlines() if each.startswith("  margins "))
    assert line == f"  margins       first 2, last {said}"


@pytest.mark.parametrize("fixed", [False, True])
@pytest.mark.parametrize("compiles", [True, False])
def test_an_export_has_its_texts_alone_with_their_hashes_and_is_told_step_by_step(
    tmp_path, monkeypatch, fixed, compiles
):
    of, told, asked = made_controller(), [], []
    source = choice.Source(tmp_path / "deep" / "my day.toml", of.origin, None, 6.125)
    files = {"tip.c": "1", "tip.h": "2", "tip_fixed.c": "3", "tip_bench.c": "4", "Makefile": "\u00b5"}
    form = SimpleNamespace(order=2, form="modal")

    def compiled(folder, code):
        asked.append(("bench", code, sorted(each.name for each in folder.iterdir())))
        (folder / "tip_bench").write_bytes(b"\0")
        (folder / "tip.o").write_bytes(b"\0")
        return "bench"

    answers = {
        "promised": lambda chosen, accept: asked.append(("promised", accept)) or "left",
        "flight_controller": lambda chosen: of,
        "sections": lambda controller: form,
        "vectors": lambda chosen, samples: f"a run of {samples}",
        "within_limits": lambda controller, run: f"{run} within",
        "_code": lambda *given: asked.append(given) or (files, "cost", "bound", "fixed" if fixed else None),
        "vectors_text": lambda controller, run: f"{run}\n",
        "compiler": lambda: "cc" if compiles else None,
        "compile_and_run": compiled,
        "stack_use": lambda folder, sources, step: asked.append(("stack", sources, step)) or "stack",
        "report_text": lambda found: f"in words: {found.bench} {found.stack}",
    }
    for name, answer in answers.items():
        monkeypatch.setattr(flight_write, name, answer)
    precision = "fixed" if fixed else "single"
    found = export_flight(
        SimpleNamespace(source=source), tmp_path / "out", name="tip", precision=precision, samples=77, accept=True,
        on_progress=lambda *given: told.append(given),
    )  # fmt: skip
    steps = ["recording 77 samples of the loop", "compiling and running the bench", "writing"]
    assert told == [(done, 3, step) for done, step in enumerate(steps)]
    code = "tip_fixed" if fixed else "tip"
    ran = [("bench", code, sorted([*files, "vectors.csv"])), ("stack", ["tip.c", "tip_fixed.c"], f"{code}_step")]
    assert asked == [("promised", True), (of, form, "a run of 77 within", "tip", precision), *ran * compiles]
    assert (found.left, found.cost, found.bound, found.samples) == ("left", "cost", "bound", 77)
    assert (found.bench, found.stack) == (("bench", "stack") if compiles else (None, None))
    texts = {**files, "vectors.csv": "a run of 77 within\n", "report.txt": f"in words: {found.bench} {found.stack}\n"}
    written = {path.name: path.read_bytes() for path in (tmp_path / "out").iterdir()}
    manifest = json.loads(written.pop("manifest.json"))
    assert written == {name: text.encode() for name, text in texts.items()}
    assert manifest["files_sha256"] == {name: hashlib.sha256(written[name]).hexdigest() for name in sorted(texts)}
    kind = {"kind": "flight code", "name": "tip", "controller": "PI \u00fcber alles", "precision": precision}
    mission_ = {"file": "my day.toml", "sha256": "0123456789abcdef" * 4, "name": "a mission"}
    assert (manifest["export"], manifest["mission"], manifest["samples"]) == (kind, mission_, 77)
    assert [*manifest["versions"]] == ["python", "microrad", "numpy", "scipy", "numba", "jinja2"]


@pytest.mark.parametrize(
    ("inverse", "forward", "share"),
    [
        (None, None, 1e-12),
        ([[0.0], [0.0]], None, 1e-12),
        ([[0.0], [0.5]], None, 1e-10),
        (None, [[0.0], [0.7]], 1e-10),
        ([[0.0]], [[-0.25]], 1e-10),
        ([[0.5]], [[0.0]], 1e-10),
        (np.zeros((0, 1)), np.zeros((0, 1)), 1e-12),
    ],
)
def test_the_share_that_code_may_differ_by_is_larger_with_any_exponent_that_is_not_one(inverse, forward, share):
    def law(powers):
        if powers is None:
            return None
        rows = np.full((len(powers), kernels.POWER + 1), 3.0)
        rows[:, kernels.POWER :] = powers
        return SimpleNamespace(bouc_wen=rows)

    assert c_code.bound_share(SimpleNamespace(inverse=law(inverse), forward=law(forward))) == share


# -------------------------------------------------------------------------------------- an export as it is asked for
@pytest.fixture
def parts_of_an_export(monkeypatch):
    """What an export is made of in place of it; gives the list of what was asked for."""
    of, asked = made_controller(), []
    answers = {
        "check_output": lambda folder, overwrite: asked.append(("folder", folder.name, overwrite)),
        "promised": lambda chosen, accept: asked.append(("accept", accept)),
        "flight_controller": lambda chosen: of,
        "sections": lambda controller: SimpleNamespace(order=2, form="modal"),
        "vectors": lambda chosen, samples: asked.append(("samples", samples)) or "run",
        "within_limits": lambda controller, run: run,
        "_code": lambda of, form, run, name, precision: (
            asked.append((name, precision)) or ({}, "cost", None, None)
        ),
        "vectors_text": lambda controller, run: "",
        "compiler": lambda: None,
        "report_text": lambda found: "",
    }  # fmt: skip
    for name, answer in answers.items():
        monkeypatch.setattr(flight_write, name, answer)
    return asked


def test_an_export_of_which_nothing_else_is_said_is_of_5000_samples_in_double_precision(tmp_path, parts_of_an_export):
    source = choice.Source(tmp_path / "m.toml", made_controller().origin, None, 6.125)
    found = export_flight(SimpleNamespace(source=source), tmp_path / "out")
    name = "pi_uber_alles"
    assert parts_of_an_export == [
        *(("folder", "out", False), ("accept", False), ("samples", 5000), (name, "double")),
    ]
    assert (found.name, found.precision, found.samples) == (name, "double", 5000)


@pytest.mark.parametrize("name", ["", "2nd"])
def test_a_name_that_is_given_is_refused_before_anything_is_recorded_even_where_it_is_empty(
    tmp_path, parts_of_an_export, name
):
    with pytest.raises(ExportError) as told:
        export_flight(SimpleNamespace(), tmp_path / "out", name=name, overwrite=True)
    assert str(told.value).startswith(f"{name!r} is no name for exported code: a name has letters")
    assert parts_of_an_export == [("folder", "out", True), ("accept", False)]
    assert not (tmp_path / "out").exists()


def test_the_report_of_fixed_point_ends_with_what_quantisation_does(monkeypatch):
    monkeypatch.setattr(flight_write, "quantisation_text", lambda fixed: f"Of {fixed}.\nA table.")
    lines = flight_write.report_text(made_export(precision="fixed", fixed="words", bound=None)).split("\n")
    assert lines[0] == "pi_code: PI über alles in fixed point"
    assert lines[-4:-2] == [
        "  cycles        626 at worst, 302 in the median, of this machine's counter at 2.5 GHz",
        "",
    ] and lines[-2:] == ["Of words.", "A table."]
    assert not [line for line in lines if line.startswith("  single")]


@pytest.mark.parametrize("precision", ["double", "single", "fixed"])
def test_each_precision_has_its_own_code_cost_and_bound(monkeypatch, precision):
    for name in ("quantised", "fixed_code", "fixed_operations", "rounding_bound", "flight_code", "operations"):
        monkeypatch.setattr(flight_write, name, lambda *given, name=name: (name, *given))
    found = flight_write._code("of", "form", "run", "tip", precision)
    bound, form = ("rounding_bound", "of", "form", "run"), ("quantised", "of", "form", "run")
    assert found == {
        "double": (("flight_code", "of", "form", "tip", "double", None), ("operations", "of", "form", "double"),
                   None, None),
        "single": (("flight_code", "of", "form", "tip", "single", bound), ("operations", "of", "form", "single"),
                   bound, None),
        "fixed": (("fixed_code", "of", "form", form, "tip"), ("fixed_operations", "of", form), None, form),
    }[precision]  # fmt: skip


def test_a_recorded_run_is_held_within_the_counts_that_the_code_can_give():
    of = made_controller(minimum_v=-4.501, maximum_v=7.2519)
    v = Vectors(np.array([[1.0, 2.0, 3.0]]), np.array([[-9.0, 1.0], [7.2515, -4.5005], [7.25, -4.5]]), 3, 4)
    found = c_code.within_limits(of, v)
    assert_allclose(found.commands, [[-4.5, 1.0], [7.25, -4.5], [7.25, -4.5]], rtol=1e-12)
    assert (found.inputs is v.inputs, found.saturated, found.rate_clamped) == (True, 3, 4)
    assert v.commands[0, 0] == -9.0, "the run itself stays as it is"


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_number_beyond_single_precision_is_refused_whichever_sign_it_has(sign):
    said = f"{sign * 1e39!r} is beyond single precision, which ends at 3.403e+38: export double precision"
    with pytest.raises(ExportError, match=f"^{re.escape(said)}$"):
        real(sign * 1e39, "single")
    assert float(real(sign * 1e39, "double")) == sign * 1e39
    assert float(real(sign * inf, "single").removesuffix("f")) == pytest.approx(sign * 3.4028235e38, rel=1e-6)


def test_an_inverse_and_how_it_learns_are_the_arrays_of_the_kernel_at_the_period(monkeypatch):
    asked = []
    names = ("direct", "bouc_wen", "bouc_wen_actuator", "play_threshold", "play_weight", "play_actuator", "widening",
             "lag_keep", "lag_weight", "lag_actuator")  # fmt: skip
    inverse = {f"inverse_{name}": np.array([float(i)]) for i, name in enumerate(names)}
    learns = {
        "adaptive_weight": "weights", "adaptive_start": "starts", "adaptive": "settings",
        "adaptive_threshold": "thresholds", "adaptive_more": "more",
    }  # fmt: skip
    monkeypatch.setattr(choice.control, "inverse_arrays", lambda *given: (asked.append(given), inverse)[1])
    monkeypatch.setattr(choice.control, "adaptive_arrays", lambda *given: (asked.append(given), learns)[1])
    for by_difference in (True, False):
        found = choice.inverse_law("inverse", 0.125, by_difference)
        assert [getattr(found, name).tolist() for name in names] == [[float(i)] for i in range(len(names))]
        assert found.by_difference is by_difference
    law = choice.adaptive_law("adaptation", 0.25)
    assert (law.settings, law.threshold, law.weight, law.start) == ("settings", "thresholds", "weights", "starts")
    assert asked == [("inverse", 0.125)] * 2 + [("adaptation", 0.25)]
    assert choice.adaptive_law(None, 0.25) is None
    assert len(asked) == 3
