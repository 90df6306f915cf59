"""The fixed-point form: the C code equals whole numbers of Python to the last bit, and its report is true.

The twin below knows the numbers of a `FixedForm` alone. Its whole numbers have no end, so that a sum beyond 64 bits
shows in it.
"""

import math
import re
import shutil
import subprocess
import tempfile
from dataclasses import replace
from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest

from drawn import plain as six_digits
from export.test_export_rounding import shipped, vectors_of
from microrad.core import lti
from microrad.export.flight import double_run, fixed_form
from microrad.export.flight import fixed as fixed_point
from microrad.export.flight.c_code import vectors_text
from microrad.export.flight.fixed import fixed_code, quantisation_text, quantised
from microrad.export.linear_part.sections import sections
from microrad.export.records import ExportError, FlightController, Origin, Signal

SHIPPED = ("LQG", "PI + inverse", "PI + inverse in series", "PID + inverse")
ONE_OF_EACH = ("LQG", pytest.param("PI + inverse", marks=pytest.mark.endurance), *SHIPPED[2:])
"""One without an inverse, one of the fine-pointing loop with it, and one of the loop of [control]."""
LARGEST, SMALLEST = 2**31 - 1, -(2**31)
FLAGS = [
    "-std=c99",
    "-O2",
    "-Wall",
    "-Wextra",
    "-Werror",
    "-pedantic",
    "-Wconversion",
    "-Wdouble-promotion",
    "-Wshadow",
]
TRAPS = ["-g", "-fsanitize=undefined", "-fno-sanitize-recover=all"]


def links(compiler):
    """Whether a compiler is here with the library of its sanitizer, which is a package of its own."""
    if shutil.which(compiler) is None:
        return False
    with tempfile.TemporaryDirectory() as folder:
        words = [compiler, *TRAPS, "-x", "c", "-", "-o", f"{folder}/empty"]
        empty = "int main(void) { return 0; }"
        return not subprocess.run(words, input=empty, text=True, capture_output=True, check=False).returncode


COMPILERS = [each for each in ("gcc", "clang") if links(each)]
PERIOD_S = 2e-4


@cache
def form_of(name):
    of, form, v = shipped(name)
    return quantised(of, form, v)


# ------------------------------------------------------------------------------------------------------------- the twin
def rounded(x, shift):
    return (x + (1 << (shift - 1)) >> shift) if shift > 0 else x


def within(x, low, high):
    return min(max(x, low), high)


def weights(matrix):
    """By row, the places and the values of the numbers that are not 0, as whole numbers of Python."""
    return [[(j, weight) for j, weight in enumerate(row) if weight] for row in matrix.tolist()]


def dot(row, numbers):
    total = 0
    for place, weight in row:
        total += weight * numbers[place]
        assert -(2**63) <= total < 2**63
    return total


class Twin:
    """The step in Python's whole numbers."""

    def __init__(self, of):
        self.of = of
        self.x = [0] * len(of.state_scale)
        self.read = [0] * len(of.input_scale)
        self.outputs, self.moves = weights(of.output.value), weights(of.state.value)

    def words(self):
        return [rounded(x, s) for x, s in zip(self.x, self.of.state_shift, strict=True)]

    def output(self, reading):
        word, signals = self.of.word, self.words()
        self.read = [within(int(r), -word, word) for r in reading]
        sums = [dot(row, signals + self.read) for row in self.outputs]
        return [within(rounded(y, s), -word, word) for y, s in zip(sums, self.of.output_shift, strict=True)]

    def update(self, excess):
        word = self.of.word
        signals = self.words() + self.read + [within(int(e), -word, word) for e in excess]
        moved = [x + dot(row, signals) for x, row in zip(self.x, self.moves, strict=True)]
        assert all(-(2**63) <= x < 2**63 for x in moved)
        self.x = [within(x, -(word << s), word << s) for x, s in zip(moved, self.of.state_shift, strict=True)]

    def step(self, reading):
        """Commands, without an inverse."""
        commands, excess = [], []
        for a, v in enumerate(self.output(reading)[: len(self.of.minimum)]):
            clipped = within(v, self.of.minimum[a], self.of.maximum[a])
            excess.append(clipped - v)
            if self.of.converter:
                c = self.of.converter[a]
                clipped = within(rounded(clipped * c.factor, c.shift), c.lowest, c.highest)
            commands.append(clipped)
        self.update(excess)
        return commands


def drive_the_linear_part(of, readings, excesses):
    twin, found = Twin(of), []
    for reading, excess in zip(readings, excesses, strict=True):
        found.append(twin.output(reading))
        twin.update(excess)
    return np.array(found)


# ----------------------------------------------------------------------------------------------------------- compiled C
DRIVER = """
#include "code_fixed.h"
#include <stdio.h>
#include <inttypes.h>
#include <string.h>
static int32_t number(void) { int64_t x = 0; if (scanf("%" SCNd64, &x) != 1) { return 0; } return (int32_t)x; }
int main(int count, char **argument)
{
    code_fixed_state state;
    int32_t in[CODE_FIXED_READINGS], out[CODE_FIXED_OUTPUTS], excess[CODE_FIXED_ACTUATORS];
    const int parts = count > 1 && strcmp(argument[1], "parts") == 0;
    const long samples = number();
    code_fixed_init(&state);
    for (long k = 0; k < samples; k++) {
        for (size_t i = 0; i < CODE_FIXED_READINGS; i++) { in[i] = number(); }
        for (size_t a = 0; a < CODE_FIXED_ACTUATORS; a++) { excess[a] = number(); }
        if (parts) {
            code_fixed_output(&state, in, out);
            code_fixed_update(&state, excess);
        } else {
            code_fixed_step(&state, in, out);
        }
        for (size_t i = 0; i < (parts ? CODE_FIXED_OUTPUTS : CODE_FIXED_ACTUATORS); i++) {
            printf("%" PRId32 " ", out[i]);
        }
        printf("\\n");
    }
    printf("%" PRIu32 " %" PRIu32 "\\n", state.saturated, state.overflowed);
    return 0;
}
"""


class Compiled:
    """The code of a fixed-point form with a driver, compiled in a folder."""

    def __init__(self, of, form, fixed, folder, compiler="gcc", options=TRAPS):
        files = fixed_code(of, form, fixed, "code")
        for file, text in files.items():
            (folder / file).write_text(text)
        (folder / "driver.c").write_text(DRIVER)
        sources = [file for file in files if file.endswith(".c") and not file.endswith("_bench.c")]
        call = [compiler, *FLAGS, *options, "-o", "driver", "driver.c", *sources, "-lm"]
        done = subprocess.run(call, cwd=folder, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
        self.folder = folder

    def run(self, readings, excesses, what):
        rows = np.hstack([readings, excesses])
        text = "\n".join([str(len(rows)), *(" ".join(map(str, row)) for row in rows.tolist())])
        done = subprocess.run(
            ["./driver", what], cwd=self.folder, input=text, capture_output=True, text=True, check=False
        )
        assert (done.returncode, done.stderr) == (0, "")
        *lines, counts = [[int(x) for x in line.split()] for line in done.stdout.splitlines()]
        return np.array(lines), counts


def extremes(rng, shape):
    """Whole numbers of 32 bits of every size, with the ends among them."""
    sizes = np.ldexp(rng.uniform(-1.0, 1.0, shape), rng.integers(0, 32, shape))
    found = np.clip(np.rint(sizes), SMALLEST, LARGEST).astype(np.int64)
    chosen = rng.integers(0, 8, shape)
    return np.where(chosen == 0, SMALLEST, np.where(chosen == 1, LARGEST, found))


def held_extremes(rng, samples, width):
    """As `extremes`, held for up to a hundred samples, so that integrators reach their ends."""
    return np.repeat(extremes(rng, (samples // 100 + 1, width)), 100, axis=0)[:samples]


needs_compiler = pytest.mark.skipif(not COMPILERS, reason="no gcc or clang here")


@pytest.mark.promise("export-14")
@needs_compiler
@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=pytest.mark.endurance if name.startswith("PI ") else []) for name in SHIPPED]
)
def test_the_compiled_code_equals_the_twin_to_the_last_bit(name, tmp_path):
    of, form, v = shipped(name)
    fixed, rng = form_of(name), np.random.default_rng(5)
    code = Compiled(of, form, fixed, tmp_path, COMPILERS[-1])
    recorded = fixed_form.readings(fixed, v.inputs)
    fuzzed = extremes(rng, (150, recorded.shape[1]))
    readings = np.vstack([recorded[:150], fuzzed, held_extremes(rng, 250, recorded.shape[1]), recorded[:50]])
    calm = [np.zeros((count, of.actuators), int) for count in (150, 300)]
    excesses = np.vstack([calm[0], extremes(rng, (150, of.actuators)), calm[1]])
    expected = drive_the_linear_part(fixed, readings, excesses)
    found, (_, overflowed) = code.run(readings, excesses, "parts")
    assert np.array_equal(found, expected)
    assert len(np.unique(found[:150])) > 125
    assert np.max(np.abs(found)) > fixed.word / 4
    assert overflowed > 50


@needs_compiler
@pytest.mark.parametrize("bits", [32, pytest.param(24, marks=pytest.mark.endurance)])
def test_a_step_without_an_inverse_equals_the_twin_and_stays_within_the_limits(bits, tmp_path):
    of, form, v = shipped("LQG")
    fixed, rng = quantised(of, form, v, bits, beyond_a_count=True), np.random.default_rng(7)
    code = Compiled(of, form, fixed, tmp_path)
    recorded = fixed_form.readings(fixed, v.inputs)
    width = recorded.shape[1]
    readings = np.vstack([recorded[:250], extremes(rng, (250, width)), held_extremes(rng, 250, width)])
    twin = Twin(fixed)
    expected = np.array([twin.step(reading) for reading in readings])
    found, (saturated, _) = code.run(readings, np.zeros((len(readings), of.actuators), int), "steps")
    assert np.array_equal(found, expected)
    commands = found * of.resolution_v
    assert np.max(commands) <= of.maximum_v
    assert np.min(commands) >= of.minimum_v
    assert saturated > 100
    assert np.max(commands) > of.maximum_v - of.resolution_v
    assert np.min(commands) < of.minimum_v + of.resolution_v


@pytest.mark.promise("export-6")
@needs_compiler
@pytest.mark.parametrize("name", ["PI + inverse in series", "PID + inverse"])
def test_a_step_with_an_inverse_stays_within_the_limits_for_any_readings(name, tmp_path):
    of, form, v = shipped(name)
    fixed, rng = form_of(name), np.random.default_rng(9)
    code = Compiled(of, form, fixed, tmp_path)
    recorded = fixed_form.readings(fixed, v.inputs)
    width = recorded.shape[1]
    readings = np.vstack([recorded[:500], extremes(rng, (700, width)), held_extremes(rng, 700, width)])
    found, (saturated, _) = code.run(readings, np.zeros((len(readings), of.actuators), int), "steps")
    commands = found * of.resolution_v
    assert np.max(np.abs(commands[:500] - v.commands[:500])) <= fixed.report.bound_v
    assert np.max(commands) <= of.maximum_v
    assert np.min(commands) >= of.minimum_v
    assert saturated > 100
    assert np.max(commands) > of.maximum_v - of.resolution_v


@pytest.mark.promise("export-14")
@needs_compiler
@pytest.mark.parametrize("name", ONE_OF_EACH)
def test_the_bench_holds_the_recorded_run(name, tmp_path):
    of, form, v = shipped(name)
    fixed = form_of(name)
    for file, text in fixed_code(of, form, fixed, "code").items():
        (tmp_path / file).write_text(text)
    sources = [path.name for path in sorted(tmp_path.glob("*.c"))]
    (tmp_path / "vectors.csv").write_text(vectors_text(of, v))
    subprocess.run([COMPILERS[0], *FLAGS, "-o", "bench", *sources, "-lm"], cwd=tmp_path, check=True)
    done = subprocess.run(["./bench", "vectors.csv", "2"], cwd=tmp_path, capture_output=True, text=True, check=False)
    told = {key: float(value) for key, value in map(str.split, done.stdout.splitlines())}
    assert done.returncode == 0, done.stdout
    assert told["largest_difference_v"] <= fixed.report.bound_v <= 2.01 * of.resolution_v
    assert told["noise_rms_v"] < 0.1 * of.resolution_v
    assert (told["samples"], told["rejected"], told["faults"], told["overflowed"]) == (len(v.inputs), 0, 0, 0)
    assert {"worst_step_ns", "median_step_ns", "clock_ns", "peak_command_v", "saturated", "rate_clamped"} < set(told)
    make = (tmp_path / "Makefile").read_text()
    assert all(source in make for source in sources)

    changed = v.commands.copy()
    changed[100, 0] += 3.0 * of.resolution_v
    (tmp_path / "vectors.csv").write_text(vectors_text(of, replace(v, commands=changed)))
    done = subprocess.run(["./bench", "vectors.csv"], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert "worst_step_ns" not in done.stdout


# ----------------------------------------------------------------------------------------------------------- the report
@pytest.mark.promise("readme-14")
@pytest.mark.promise("export-17")
@pytest.mark.parametrize("name", ONE_OF_EACH)
def test_the_report_is_true(name):
    of, form, v = shipped(name)
    fixed, r = form_of(name), form_of(name).report
    read, n = fixed_form.readings(fixed, v.inputs), of.actuators
    near = fixed_form.dequantised(form, fixed)
    exact = double_run.run_in_double(of, near, v.inputs)
    found = drive_the_linear_part(fixed, read, np.zeros((len(read), n), int)) * np.exp2(-np.array(fixed.output_scale))
    assert not np.any(exact.excess)
    for i, o in enumerate(r.outputs):
        measured = np.sqrt(np.mean((found[:, i] - exact.outputs[:, i]) ** 2))
        assert o.noise_measured == pytest.approx(measured, rel=1e-6, abs=1e-18)
        assert measured <= 2.0 * o.noise_predicted
        assert 0.0 <= o.cycle_found <= o.cycle_bound
        own = 2.0 ** -fixed.output_scale[i] / math.sqrt(12.0)  # rounding of the output itself
        assert o.noise_predicted >= own * (1.0 - 1e-12)
    assert any(o.noise_measured > 0.3 * o.noise_predicted for o in r.outputs)
    ranges = fixed.word * np.exp2(-np.array(fixed.state_scale))
    peaks = np.max(np.abs(double_run.run_in_double(of, form, v.inputs).states), axis=0)
    moving = peaks > 0.0
    assert np.array(r.head_room_bits)[moving] == pytest.approx(np.log2(ranges[moving] / peaks[moving]))
    assert np.all(np.array(r.head_room_bits) >= 2.0)
    assert np.min(r.head_room_bits) < 3.0
    assert r.samples == len(v.inputs)


@pytest.mark.promise("export-17")
@pytest.mark.parametrize("name", SHIPPED)
def test_the_poles_and_the_response_are_those_of_the_coefficients(name):
    of, form, _ = shipped(name)
    fixed = form_of(name)
    near = fixed_form.dequantised(form, fixed)
    before, after = (np.sort(np.abs(np.linalg.eigvals(each.A))) for each in (form, near))
    assert np.sort([abs(a) for a, _ in fixed.report.poles]) == pytest.approx(before, abs=1e-7)
    assert np.sort([abs(b) for _, b in fixed.report.poles]) == pytest.approx(after, abs=1e-7)
    assert np.all(after <= 1.0)
    worst = max(fixed.report.outputs, key=lambda o: o.response_error)
    i = fixed.report.outputs.index(worst)
    of_form, of_near = (
        lti.frequency_response(lti.StateSpace(s.A, s.B, s.C, s.D), np.array([worst.at_hz]), of.period_s)[0, i]
        for s in (form, near)
    )
    error = np.linalg.norm(of_near - of_form) / np.linalg.norm(of_form)
    assert worst.response_error == pytest.approx(error, rel=1e-6, abs=1e-15)
    assert error < 1e-4


def test_the_coefficients_are_within_half_a_step_and_rows_within_a_word():
    _, form, _ = shipped("LQG")
    fixed = form_of("LQG")
    near, columns = (
        fixed_form.dequantised(form, fixed),
        np.array([*fixed.state_scale, *fixed.input_scale, *fixed.output_scale]),
    )
    for a, b, rows in (
        (np.hstack([form.A, form.B, form.L]), np.hstack([near.A, near.B, near.L]), fixed.state),
        (np.hstack([form.C, form.D]), np.hstack([near.C, near.D]), fixed.output),
    ):
        step = np.exp2(columns[None, : a.shape[1]] - np.array(rows.scale)[:, None])
        assert np.all(np.abs(a - b) <= 0.5 * step + 1e-15)
        still = np.eye(*b.shape) if rows is fixed.state else 0.0  # the whole numbers are those of the change
        np.testing.assert_allclose(b, rows.value * step + still, rtol=1e-15, atol=0.0)
        sums = np.sum(np.abs(rows.value), axis=1)
        assert np.all(sums <= fixed.word)
        assert np.median(sums) > fixed.word / 4
    assert np.any(near.A != form.A)
    assert min(fixed.state_shift) >= 0
    assert max(fixed.state_shift) <= fixed.bits - 1


@pytest.mark.parametrize("name", ["LQG", "PI + inverse"])
def test_the_makefile_compiles_the_sources_and_looks_at_the_headers(name):
    of, form, _ = shipped(name)
    files = fixed_code(of, form, form_of(name), "loop")
    lines = dict(line.split(" = ", 1) for line in files["Makefile"].splitlines() if " = " in line)
    for key, ending in (("SOURCES", ".c"), ("HEADERS", ".h")):
        assert sorted(lines[key].split()) == sorted(file for file in files if file.endswith(ending))
    assert {"loop_fixed.c", "loop_fixed_bench.c", "loop_fixed.h", "Makefile"} <= files.keys()
    assert ("loop_inverse.c" in files) is (name != "LQG")


def test_a_row_that_rounds_up_beyond_a_word_takes_a_coarser_scale():
    rows = fixed_form._rows(np.array([[63.5, 63.5], [63.0, 64.0]]), (0, 0), 127, [9, 9])
    assert rows.scale == (-1, 0)
    assert rows.value.tolist() == [[32, 32], [63, 64]]


@pytest.mark.promise("export-17")
def test_the_text_of_the_report_has_units():
    text = quantisation_text(form_of("PI + inverse"))
    units = ("rad/s", " rad ", " Hz", " dB", " bits", " V  ")
    for part in ("Words of 32 bits", "4 times", " V over them", "at rest", "2^-", *units):
        assert part in text
    assert "e-0" in text.splitlines()[1]
    assert max(map(len, text.splitlines())) <= 120
    assert "inverse" in text
    assert "inverse" not in quantisation_text(form_of("LQG"))


# ---------------------------------------------------------------------------------------------------- other controllers
def one_axis(A, B, C, D, *, limit_v=10.0, resolution_v=1e-3, windup=0.0):
    system = lti.StateSpace(*(np.array(m, dtype=float) for m in (A, B, C, D)))
    return FlightController(
        name="a design",
        origin=Origin("a mission", "0" * 64, "a mirror"),
        period_s=PERIOD_S,
        inputs=(Signal("reading_rad", system.B.shape[1], "rad", "reading", 0.1),),
        actuators=1,
        system=system,
        anti_windup=np.full((system.order, 1), windup),
        inverse=None,
        minimum_v=-limit_v,
        maximum_v=limit_v,
        resolution_v=resolution_v,
        bias_v=0.0,
        margins=(),
    )


def slow_design(pole=1.0 - 1e-7, **changes):
    return one_axis([[pole]], [[100.0]], [[1.0]], [[3000.0]], **changes)


def noise(samples=600, size=1e-4):
    return size * np.random.default_rng(2).standard_normal((samples, 1))


def made(of, inputs, *args, **options):
    form = sections(of)
    return quantised(of, form, vectors_of(inputs), *args, **options)


def test_an_integrator_adds_up_the_smallest_reading():
    of = one_axis([[1.0]], [[100.0]], [[1.0]], [[3000.0]])
    fixed = made(of, noise())
    step = fixed_form.Step(fixed)
    least = 2.0 ** -fixed.input_scale[0]
    for _ in range(4000):
        step.output(np.array([1]))
        step.update(np.array([0]))
    wanted = 4000 * 100.0 * least
    scale = sections(of).C[0, 0]
    assert step.x[0] * 2.0 ** -fixed.state.scale[0] * scale == pytest.approx(wanted, rel=1e-6)
    assert step.x[0] > 0


@pytest.mark.parametrize("off", [-2.6e-11, 2.5e-11])
def test_an_integrator_that_rounding_moved_a_little_is_one_again(off):
    fixed = made(one_axis([[1.0 + off]], [[100.0]], [[1.0]], [[3000.0]]), noise())
    assert fixed.report.poles == ((1.0 + 0.0j, 1.0 + 0.0j),)


def test_a_resting_signal_is_scaled_by_its_limit_and_its_states_by_what_it_can_do():
    of = replace(
        one_axis([[0.9, 0.0], [0.0, 0.5]], np.eye(2), [[1.0, 2.0]], [[0.0, 0.0]]),
        inputs=(Signal("first_rad", 1, "rad", "first", 0.1), Signal("second_rad", 1, "rad", "second", 0.3)),
    )
    inputs = np.hstack([noise(), np.zeros((600, 1))])
    fixed = made(of, inputs)
    ranges = fixed.word * np.exp2(-np.array(fixed.input_scale))
    assert 4.0 * np.max(np.abs(inputs)) <= ranges[0] <= 8.0 * np.max(np.abs(inputs))
    assert 4.0 * 0.3 <= ranges[1] <= 8.0 * 0.3
    still = np.argmax(fixed.report.head_room_bits)
    reach = 4.0 * 0.3 / (1.0 - 0.5) * np.abs(sections(of).B[still, 1])
    assert reach <= fixed.word * 2.0 ** -fixed.state_scale[still] <= 2.0 * reach * (1 + 1e-9)
    assert "at rest" in quantisation_text(fixed)


@pytest.mark.promise("export-13")
@needs_compiler
@pytest.mark.parametrize(("limit", "counts"), [(1.0, 100), (0.9999, 99), (0.994, 99), (1.0 - 1e-12, 100)])
def test_counts_stay_within_limits_that_are_no_multiples_of_the_resolution(limit, counts):
    of = SimpleNamespace(resolution_v=0.01, minimum_v=-limit, maximum_v=limit)
    made = fixed_form._converter(of, 20)
    assert (made.lowest, made.highest) == (-counts, counts)


def test_without_converter_and_limits_commands_are_words(tmp_path):
    of = slow_design(0.99, limit_v=math.inf, resolution_v=0.0)
    form, fixed = sections(of), made(of, noise())
    readings = fixed_form.readings(fixed, noise(200))
    twin = Twin(fixed)
    expected = np.array([twin.step(reading) for reading in readings])
    found, (saturated, _) = Compiled(of, form, fixed, tmp_path).run(readings, np.zeros((200, 1), int), "steps")
    assert np.array_equal(found, expected)
    ideal = double_run.run_in_double(of, form, noise(200)).free
    assert found * 2.0 ** -fixed.output_scale[0] == pytest.approx(ideal, abs=1e-6 * np.max(np.abs(ideal)))
    assert saturated == 0
    assert fixed.converter == ()


@needs_compiler
def test_a_controller_without_states_is_a_gain(tmp_path):
    of = one_axis(np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), [[3000.0]])
    form, inputs = sections(of), noise(300)
    fixed = made(of, inputs)
    readings = fixed_form.readings(fixed, inputs)
    found, _ = Compiled(of, form, fixed, tmp_path).run(readings, np.zeros((300, 1), int), "steps")
    assert np.max(np.abs(found * 1e-3 - 3000.0 * inputs)) <= 0.5001e-3
    assert np.max(np.abs(found)) > 100


@pytest.mark.promise("export-9")
def test_the_anti_windup_holds_the_state_at_the_limit():
    of = one_axis([[1.0]], [[300.0]], [[1.0]], [[3000.0]], limit_v=1.0, windup=0.09)
    inputs = np.full((400, 1), 8e-4)
    fixed = made(of, inputs)
    twin, ideal = Twin(fixed), double_run.run_in_double(of, sections(of), inputs)
    for reading in fixed_form.readings(fixed, inputs):
        command = twin.step(reading)
    assert command == [1000]
    state = twin.x[0] * 2.0 ** -fixed.state.scale[0]
    assert state == pytest.approx(ideal.states[-1, 0], rel=1e-3)
    assert np.count_nonzero(ideal.excess) > 300
    assert fixed.report.error_v < 1e-6


# ------------------------------------------------------------------------------------------------------------- refusals
@pytest.mark.parametrize("bits", [7, 33])
def test_other_words_are_refused(bits):
    with pytest.raises(ExportError, match=rf"^{bits} bits in fixed point: give 8 to 32"):
        made(slow_design(0.99), noise(), bits)


@pytest.mark.promise("export-17")
def test_poles_that_reach_the_circle_are_refused():
    of = slow_design(1.0 - 1e-9)
    with pytest.raises(ExportError) as told:
        made(of, noise(), 16, beyond_a_count=True)
    poles = ("|z| = 0.999999999 at 0 Hz", "|z| = 1.000000000")
    for part in ("'a design'", "16 bits", *poles, "limit is 1", "more bits"):
        assert part in str(told.value)
    ((before, after),) = made(of, noise(), 32, beyond_a_count=True).report.poles
    assert after.real == pytest.approx(before.real, abs=1e-10)
    assert after.real < 1.0


def undamped(turn):
    """An oscillator that neither grows nor decays."""
    c, s = math.cos(turn), math.sin(turn)
    return one_axis([[c, -s], [s, c]], [[1.0], [0.0]], [[1.0, 0.0]], [[1.0]])


@pytest.mark.promise("export-17")
def test_an_undamped_oscillator_is_refused_where_its_pole_leaves_the_circle():
    with pytest.raises(ExportError, match=r"\|z\| = 1\.000000000 at 795\.8 Hz moves to \|z\| = 1\.000132075, and the"):
        made(undamped(1.0), noise(), 12, beyond_a_count=True)
    ((_, after), _) = made(undamped(0.5), noise(), 12, beyond_a_count=True).report.poles
    assert abs(after) < 1.0


@pytest.mark.parametrize(("turn", "bits"), [(0.3, 8), (0.3, 16), (1.0, 32), (2.0, 8)])
def test_an_undamped_oscillator_is_compared_beside_its_own_frequency(turn, bits):
    (output,) = made(undamped(turn), noise(), bits, beyond_a_count=True).report.outputs
    assert 0.1 < output.response_error < 100.0
    assert output.at_hz == pytest.approx(turn / (2.0 * math.pi * PERIOD_S), rel=1e-3)


@pytest.mark.promise("export-17")
def test_commands_that_stray_by_more_than_a_count_are_refused_unless_said():
    of = slow_design(0.999, resolution_v=1e-5)
    with pytest.raises(ExportError) as told:
        made(of, noise(), 12)
    for part in ("'a design'", "12 bits", " V off double precision over 600 samples", "1e-05 V", "more bits"):
        assert part in str(told.value)
    said = made(of, noise(), 12, beyond_a_count=True)
    assert said.report.error_v > of.resolution_v
    assert said.report.bound_v > said.report.error_v
    assert made(of, noise(), 32).report.error_v < 0.01 * of.resolution_v


@pytest.mark.promise("export-17")
def test_numbers_that_do_not_fit_are_refused():
    of = one_axis([[0.9]], [[1.0]], [[1.0]], [[1.0]], resolution_v=1e-30)
    with pytest.raises(ExportError, match=r"'a design' does not fit into words of 32 bits.*single precision"):
        made(of, noise())
    assert made(replace(of, resolution_v=1e-3), noise()).converter[0].shift <= 62


@pytest.mark.parametrize(
    ("changes", "size", "why"),
    [
        ({"C": [[1e30]]}, 0.0, r"the numbers of a row are 2\^66 beyond the range of its sum"),
        ({"windup": 1e30}, 1e-4, r"the numbers of a row are 2\^83 beyond the range of its sum"),
        (
            {"resolution_v": 1e-30},
            1e-4,
            "a count of its converter, or a number in the run, is nothing beside its words",
        ),
        ({}, 1e-296, "a number in the run, is nothing beside its words"),
        ({}, 1e-320, "a number in the run, is nothing beside its words"),
    ],
)
def test_what_is_beyond_a_word_is_said(changes, size, why):
    of = {"A": [[0.9]], "B": [[1.0]], "C": [[1.0]], "D": [[1.0]], **changes}
    with pytest.raises(ExportError, match=rf"'a design' does not fit into words of 32 bits: .*{why}; give more bits"):
        made(one_axis(**of), noise(size=size))
    taken = made(one_axis([[0.9]], [[1.0]], [[1.0]], [[1.0]]), noise(size=1e-285))
    assert 950 < max(taken.input_scale) <= 1000


def test_names_are_identifiers():
    of = slow_design(0.99)
    form, fixed = sections(of), made(of, noise())
    with pytest.raises(ExportError, match="2fast"):
        fixed_code(of, form, fixed, "2fast")
    assert set(fixed_code(of, form, fixed, "fast")) == {
        "fast_fixed.h",
        "fast_fixed.c",
        "fast_fixed_bench.c",
        "Makefile",
    }


@pytest.mark.promise("export-17")
def test_the_report_measures_the_swing_of_a_rest():
    """A coarse oscillation keeps swinging at rest, by no more than the report says is possible."""
    z = 0.9995 * np.exp(0.5j)
    of = one_axis([[z.real, -z.imag], [z.imag, z.real]], [[1.0], [0.5]], [[100.0, 30.0]], [[0.0]])
    fixed = made(of, noise(), 12, beyond_a_count=True)
    assert 0.0 < fixed.report.outputs[0].cycle_found <= fixed.report.outputs[0].cycle_bound
    fine = made(of, noise(), 32)
    assert fine.report.outputs[0].cycle_bound < 1e-4 * fixed.report.outputs[0].cycle_bound


# --------------------------------------------------------------------------------- two commands whose numbers differ
def two_axes(**changes):
    """An integrator, a slow pole and a pair; two readings of unlike sizes; limits that are not alike."""
    A = np.array([[1.0, 0.0, 0.0, 0.0], [0.0, 0.98, 0.0, 0.0], [0.0, 0.0, 0.7, -0.3], [0.0, 0.0, 0.3, 0.7]])
    B = np.array([[20.0, 0.0], [0.0, 50.0], [10.0, 5.0], [0.0, 4.0]])
    C = np.array([[1.0, 0.0, 2.0, 0.0], [0.0, 3.0, 0.0, 1.0]])
    D = np.array([[300.0, 0.0], [100.0, 700.0]])
    of = one_axis(A, B, C, D)
    given = {
        "actuators": 2,
        "inputs": (Signal("first_rad", 1, "rad", "the first", 0.1), Signal("second_rad", 1, "rad", "the second", 0.3)),
        "anti_windup": np.array([[0.1, 0.0], [0.0, 0.2], [0.0, 0.0], [0.05, 0.0]]),
        "minimum_v": -3.1234,
        "maximum_v": 5.4321,
        "resolution_v": 0.01,
    }
    return replace(of, **given | changes)


def two_readings(samples=800):
    k = np.arange(samples)
    return np.stack([2e-3 * np.sin(0.3 * k), 9e-3 * np.cos(0.011 * k) - 1e-3], axis=1)


def sixteen_bits(bits=16, **changes):
    of = two_axes(**changes)
    return of, made(of, two_readings(), bits, beyond_a_count=True)


def test_each_number_of_two_axes_has_its_own_scale_limit_and_converter():
    _, fixed = sixteen_bits()
    found = {name: getattr(fixed, name) for name in ("bits", "input_scale", "state_scale", "output_scale")}
    found |= {"minimum": fixed.minimum, "maximum": fixed.maximum}
    found |= {"state": fixed.state.scale, "output": fixed.output.scale, "shift": fixed.state_shift}
    found |= {"state_values": fixed.state.value.tolist(), "output_values": fixed.output.value.tolist()}
    found |= {"output_shift": fixed.output_shift, "converter": [six_digits(each) for each in fixed.converter]}
    assert six_digits(found) == {
        "bits": 16,
        "input_scale": [21, 19],
        "state_scale": [20, 19, 23, 20],
        "output_scale": [10, 10],
        "minimum": [-3198, -3198],
        "maximum": [5562, 5562],
        "state": [34, 32, 37, 34],
        "output": [27, 23],
        "shift": [14, 13, 14, 14],
        "state_values": [
            [-4915, -9830, 0, 0, 5120, 10240, 0, 0],
            [1229, -2458, 0, 0, 0, 2048, 13107, 0],
            [0, 0, 0, 0, 2560, 0, 26214, 0],
            [0, 0, 0, -328, 0, 6400, 0, 13107],
        ],
        "output_values": [[4096, 0, 8192, 0, 19200, 0], [0, 256, 0, 6144, 400, 11200]],
        "output_shift": [17, 13],
        "converter": [
            {"factor": 838860800, "shift": 33, "lowest": -312, "highest": 543},
            {"factor": 838860800, "shift": 33, "lowest": -312, "highest": 543},
        ],
    }


def test_the_report_of_two_axes_has_each_output_pole_and_state():
    of, fixed = sixteen_bits()
    report = six_digits(fixed.report)
    report.pop("poles")
    assert {key: value for key, value in report.items() if key != "outputs"} == {
        "samples": 800,
        "period_s": 0.0002,
        "head_room_bits": [2.64782, 2.42609, 2.90956, 2.26462],
        "error_v": 0.00315436,
        "inverse_v": 0.0,
        "resolution_v": 0.01,
        "bound_v": 0.0100013,
    }
    rows = [[each["name"], each["unit"]] for each in report["outputs"]]
    assert rows == [["v 0", "V"], ["v 1", "V"]] and fixed_form.output_groups(of) == (("v", "V", 2),)
    assert [[f"{q.noise_predicted:.4g}", f"{q.noise_measured:.4g}"] for q in fixed.report.outputs] == [
        ["0.0002963", "0.0003224"],
        ["0.0006685", "0.0007103"],
    ]
    text = quantisation_text(fixed).split("\n")
    assert text[:2] == [
        ("Words of 16 bits, sums of 64. Ranges are at least 4 times the largest sizes in 800 recorded samples."),
        (
            "Commands stray from double precision by at most 0.00315 V over them, ahead of the "
            "converter (a count is 0.01 V)."
        ),
    ]


def test_the_text_of_a_report_has_each_number_under_its_heading():
    _, fixed = sixteen_bits()
    quality = fixed_form.OutputQuality("drive of hysteresis 1", "V", 0.01, 250.0, 2e-4, 1.5e-4, 3e-3, 2.5e-3)
    other = replace(quality, name="v 0", response_error=0.002, at_hz=12.5, cycle_found=0.0)
    report = fixed_form.QuantisationReport(
        900,
        2e-4,
        ((0.5 + 0.5j, 0.25 + 0.5j), (1.0 + 0j, 1.0 + 0j)),
        (other, quality),
        (3.25, 64.0),
        2e-3,
        5e-5,
        1e-2,
        4e-2,
    )
    shown = replace(fixed, report=report, state_scale=(7, 9), state=replace(fixed.state, scale=(20, 31)))
    assert quantisation_text(shown).split("\n") == [
        ("Words of 16 bits, sums of 64. Ranges are at least 4 times the largest sizes in 900 recorded samples."),
        (
            "Commands stray from double precision by at most 0.002 V over them, ahead of the "
            "converter (a count is 0.01 V)."
        ),
        "The feedforward, in single precision, adds up to 5e-05 V to that.",
        "",
        (
            "               output    response       at  noise rms, predicted    measured  "
            "swing at rest, most       found"
        ),
        (
            "                  v 0  1.7e-02 dB  12.5 Hz            2.00e-04 V  1.50e-04 V      "
            "     3.00e-03 V  0.00e+00 V"
        ),
        (
            "drive of hysteresis 1  8.6e-02 dB   250 Hz            2.00e-04 V  1.50e-04 V      "
            "     3.00e-03 V  2.50e-03 V"
        ),
        "",
        "  pole    |z| as designed   |z| as quantised",
        "625 Hz  0.707106781186548  0.559016994374947",
        "  0 Hz  1.000000000000000  1.000000000000000",
        "",
        "state  head room  a step is  bits below",
        "    0   3.2 bits       2^-7          13",
        "    1    at rest       2^-9          22",
    ]
    plain_one = replace(report, outputs=(other,), inverse_v=2e-5, resolution_v=0.0)
    assert quantisation_text(replace(shown, report=plain_one)).split("\n")[1:3] == [
        "Commands stray from double precision by at most 0.002 V over them, ahead of the converter.",
        "The inverse, in single precision, adds up to 2e-05 V to that.",
    ]


@pytest.mark.parametrize(
    ("bits", "changes", "said"),
    [
        (7, {}, "7 bits in fixed point: give 8 to 32 (sums have 64)"),
        (33, {}, "33 bits in fixed point: give 8 to 32 (sums have 64)"),
        (
            12,
            {"resolution_v": 1e-4},
            "controller 'a design' in words of 12 bits commands up to (x) V off double precision over 800 samples, "
            "more than a count of the converter (0.0001 V); give more bits (up to 32), or say that more than a count "
            "will do",
        ),
    ],
)
def test_words_that_are_too_short_are_refused_in_all_their_words(bits, changes, said):
    of = two_axes(**changes)
    with pytest.raises(ExportError) as error:
        made(of, two_readings(), bits)
    assert re.sub(r"up to [\d.e-]+ V off", "up to (x) V off", str(error.value)) == said


def test_a_pole_beyond_the_circle_is_refused_by_its_frequency():
    fixed = SimpleNamespace(bits=12)
    moved = ((0.6 + 0.79j, 0.62 + 0.8j),)
    with pytest.raises(ExportError) as error:
        fixed_point._refuse_poles(two_axes(), fixed, moved)
    assert str(error.value) == (
        "controller 'a design' in words of 12 bits: the pole of |z| = 0.992018145 at 733.1 "
        "Hz moves to |z| = 1.012126474, and the limit is 1; give more bits (up to 32) or "
        "less head room, or export single precision"
    )
    fixed_point._refuse_poles(two_axes(), fixed, ((0.6 + 0.8j, 0.6 + 0.8j), (1.0 + 0j, 1.0 + 0j)))


def test_the_code_of_two_axes_has_each_table_and_constant():
    of, fixed = sixteen_bits()
    files = fixed_code(of, sections(of), fixed, "two")
    assert sorted(files) == ["Makefile", "two_fixed.c", "two_fixed.h", "two_fixed_bench.c"]
    header = [line for line in files["two_fixed.h"].split("\n") if line.startswith("#define")]
    assert header == [
        "#define TWO_FIXED_H",
        "#define TWO_FIXED_PERIOD_S 0.0002",
        "#define TWO_FIXED_BITS 16 /* of coefficients and signals */",
        "#define TWO_FIXED_FIRST_RAD 0U",
        "#define TWO_FIXED_FIRST_RAD_SIZE 1U",
        "#define TWO_FIXED_FIRST_RAD_UNIT 4.76837158203125e-07 /* 2^-21 rad */",
        "#define TWO_FIXED_SECOND_RAD 1U",
        "#define TWO_FIXED_SECOND_RAD_SIZE 1U",
        "#define TWO_FIXED_SECOND_RAD_UNIT 1.9073486328125e-06 /* 2^-19 rad */",
        "#define TWO_FIXED_READINGS 2U",
        "#define TWO_FIXED_V 0U",
        "#define TWO_FIXED_V_UNIT 0.0009765625 /* 2^-10 V: v: the command */",
        "#define TWO_FIXED_OUTPUTS 2U",
        "#define TWO_FIXED_ACTUATORS 2U",
        "#define TWO_FIXED_BIAS_V 0.0",
        "#define TWO_FIXED_COMMAND_UNIT_V 0.01 /* a count of the converter */",
        "#define TWO_FIXED_STATES 4U",
    ]
    source = files["two_fixed.c"]
    tables_ = [line.strip() for line in source.split("\n") if re.match(r"\s*\{-?\d+, ", line) or "static const" in line]
    assert tables_ == [
        "static const whole_term WHOLE_OUTPUT_OF_STATES[] = {",
        "{0, 0, 4096},",
        "{0, 2, 8192},",
        "{1, 1, 256},",
        "{1, 3, 6144},",
        "static const whole_term WHOLE_OUTPUT_OF_READINGS[] = {",
        "{0, 0, 19200},",
        "{1, 0, 400},",
        "{1, 1, 11200},",
        "static const whole_term WHOLE_STATE_OF_STATES[] = {",
        "{0, 0, -4915},",
        "{0, 1, -9830},",
        "{1, 0, 1229},",
        "{1, 1, -2458},",
        "{3, 3, -328},",
        "static const whole_term WHOLE_STATE_OF_READINGS[] = {",
        "{0, 0, 5120},",
        "{0, 1, 10240},",
        "{1, 1, 2048},",
        "{2, 0, 2560},",
        "{3, 1, 6400},",
        "static const whole_term WHOLE_STATE_OF_EXCESS[] = {",
        "{1, 0, 13107},",
        "{2, 0, 26214},",
        "{3, 1, 13107},",
        "static const int STATE_SHIFT[TWO_FIXED_STATES] = {14, 13, 14, 14};",
        "static const int OUTPUT_SHIFT[TWO_FIXED_OUTPUTS] = {17, 13};",
        "static const int64_t COMMAND_MIN[TWO_FIXED_ACTUATORS] = {-3198, -3198};",
        "static const int64_t COMMAND_MAX[TWO_FIXED_ACTUATORS] = {5562, 5562};",
        "static const int64_t COUNT_FACTOR[TWO_FIXED_ACTUATORS] = {838860800, 838860800};",
        "static const int COUNT_SHIFT[TWO_FIXED_ACTUATORS] = {33, 33};",
        "static const int64_t COUNT_MIN[TWO_FIXED_ACTUATORS] = {-312, -312};",
        "static const int64_t COUNT_MAX[TWO_FIXED_ACTUATORS] = {543, 543};",
    ]


@pytest.mark.parametrize(
    ("size", "word", "scale"),
    [
        (0.3, 2**15 - 1, 16),
        (1.0, 2**15 - 1, 14),
        (2.0**20, 2**15 - 1, -6),
        (1e-320, 2**31 - 1, 1024),
        (3e9, 2**31 - 1, -1),
    ],
)
def test_a_number_is_at_the_finest_power_of_two_at_which_it_fits(size, word, scale):
    assert fixed_form._scale(size, word) == scale
    if size > 1e-300:
        assert math.ldexp(size, scale) <= word < math.ldexp(size, scale + 1)


@pytest.mark.parametrize(
    ("before", "after", "hz"),
    [
        (complex(0.6, 0.799), complex(0.6, 0.8001), "368.7"),
        (complex(0.6, -0.799), complex(0.6, -0.8001), "368.7"),
        (complex(-0.999, 0.0), complex(-1.0, 0.0), "1250"),
        (complex(1.0, 0.0), complex(1.0001, 0.0), "0"),
    ],
)
def test_a_pole_that_leaves_the_circle_is_told_by_its_frequency_whatever_side_it_is_on(before, after, hz):
    of, made = SimpleNamespace(name="PI", period_s=4e-4), SimpleNamespace(bits=12)
    with pytest.raises(ExportError) as told:
        fixed_point._refuse_poles(of, made, ((0.5, 0.5), (before, after)))
    assert str(told.value) == (
        f"controller 'PI' in words of 12 bits: the pole of |z| = {abs(before):.9f} at {hz} Hz moves to |z| = "
        f"{abs(after):.9f}, and the limit is 1; give more bits (up to {fixed_point.MOST_BITS}) or less head room, or "
        "export single precision"
    )
    fixed_point._refuse_poles(of, made, ((1.0, 1.0), (complex(0.6, 0.8), complex(0.6, 0.8)), (0.9, 0.999999)))


@pytest.mark.parametrize(
    ("x", "shift", "found"),
    [([5, 6, -5, -6, -7], [2] * 5, [1, 2, -1, -1, -2]), ([7, -7, 0], [0, 0, 0], [7, -7, 0]), ([7, 9], [3, 1], [1, 5])],
)
def test_whole_numbers_are_rounded_to_the_nearest_ties_up(x, shift, found):
    assert fixed_form._rounded(np.array(x, dtype=np.int64), np.array(shift)).tolist() == found


def test_rows_have_each_the_finest_scale_at_which_their_sum_fits():
    made = fixed_form._rows(np.array([[1.0, -3.0], [0.0, 0.0], [1e-9, 0.0]]), (4, 5), 2**15 - 1, [40, 21, 20])
    weights = 1.0 / 16.0 + 3.0 / 32.0
    assert made.scale == (math.floor(math.log2((2**15 - 1) / weights)), 21, 20)
    assert made.value.tolist() == [[2**17 // 16, -3 * 2**17 // 32], [0, 0], [0, 0]]


def test_a_converter_has_the_scale_of_its_own_command(monkeypatch):
    monkeypatch.setattr(fixed_form, "_output_ranges", lambda of, form, ideal, sizes: np.array([8.0, 0.5]))
    of, fixed = sixteen_bits()
    assert fixed.output_scale == (11, 15)
    for scale, each in zip(fixed.output_scale, fixed.converter, strict=True):
        assert each.factor * 2.0**-each.shift == pytest.approx(2.0**-scale / of.resolution_v, rel=1e-8)


@pytest.mark.parametrize(
    ("changes", "why"),
    [
        ({}, ""),
        ({"state_shift": (5, -3), "output_shift": (-7, 0)}, "the numbers of a row are 2^7 beyond the range of its sum"),
        ({"state_shift": (-2, 5)}, "the numbers of a row are 2^2 beyond the range of its sum"),
        ({"state_shift": (), "output_shift": ()}, ""),
        ({"converter": (1, 63)}, "a count of its converter, or a number in the run, is nothing beside its words"),
        ({"converter": (0, 62)}, "a count of its converter, or a number in the run, is nothing beside its words"),
        ({"input_scale": (3, 1001)}, "a count of its converter, or a number in the run, is nothing beside its words"),
        ({"state_scale": (1001, 3)}, "a count of its converter, or a number in the run, is nothing beside its words"),
        ({"converter": ()}, ""),
    ],
)
def test_a_number_that_is_beyond_a_word_is_told_wherever_it_stands(changes, why):
    given = {"state_shift": (0, 4), "output_shift": (3, 0), "converter": (1, 62), **changes}
    given = {"input_scale": (7, 1000), "state_scale": (1000, -5), **given}
    given["converter"] = [SimpleNamespace(shift=shift) for shift in given["converter"]]
    form = SimpleNamespace(bits=12, **given)
    if not why:
        fixed_point._refuse_what_does_not_fit(SimpleNamespace(name="PI"), form)
        return
    with pytest.raises(ExportError) as told:
        fixed_point._refuse_what_does_not_fit(SimpleNamespace(name="PI"), form)
    assert str(told.value) == (
        f"controller 'PI' does not fit into words of 12 bits: {why}; give more bits (up to 32), or export single "
        "precision"
    )


@pytest.mark.parametrize(
    ("low", "high", "free", "largest"),
    [
        (-9.0, math.inf, 1.0, 9.0),
        (-math.inf, 3.0, -1.0, 3.0),
        (-2.0, 5.0, -7.0, 7.0),
        (-math.inf, math.inf, -0.75, 0.75),
        (-math.inf, math.inf, 0.125, 0.5),
    ],
)
def test_a_command_has_a_range_of_four_times_the_farthest_limit_or_what_was_commanded(low, high, free, largest):
    """Two actuators, and a target about each: of a kind all numbers have the range of the largest."""
    of = SimpleNamespace(
        actuators=2, minimum_v=low, maximum_v=high, forward=None, system=SimpleNamespace(C=np.zeros((4, 1)))
    )
    ideal = SimpleNamespace(
        outputs=np.array([[0.25, -0.5, 1e-3, 2e-3], [0.0, 0.0, -6e-3, 0.0]]), free=np.array([[0.25, 0.0], [0.1, free]])
    )
    form = SimpleNamespace(C=np.zeros((4, 1)), A=np.eye(1), B=np.ones((1, 1)))
    found = fixed_form._output_ranges(of, form, ideal, np.ones(1))
    assert found.tolist() == pytest.approx([4.0 * largest, 4.0 * largest, 0.024, 0.024])


@pytest.mark.parametrize(
    ("low", "high", "ends"),
    [
        (-math.inf, math.inf, (1 - 2**31, 2**31 - 1)),
        (-math.inf, 0.995, (1 - 2**31, 99)),
        (-0.125, math.inf, (-12, 2**31 - 1)),
        (-0.3, 2.0, (-30, 200)),
        (0.105, 0.3, (11, 30)),
    ],
)
def test_a_converter_without_a_limit_counts_as_far_as_a_word(low, high, ends):
    """A step of 2^-20 V is 0.78125 2^-13 counts of 10 mV."""
    of = SimpleNamespace(resolution_v=0.01, minimum_v=low, maximum_v=high)
    assert fixed_form._converter(of, 20) == fixed_form.Converter(838_860_800, 43, *ends)


def test_integrators_that_rounding_moved_are_made_whole_in_a_copy_and_pairs_stay_as_they_are():
    """One above 1 and one below it; a pair whose entries are as near to 1, and a slow pole."""
    A = np.diag([1.0 + 3e-11, 1.0 - 3e-11, 1.0 - 3e-11, 1.0 - 4e-11, 1.0 - 1e-9])
    A[1, 2] = 1e-6
    given = A.copy()
    zeros = np.zeros((5, 1))
    form = fixed_point.Sections("modal", ((0, 1), (1, 2), (3, 1), (4, 1)), A, zeros, zeros.T, np.zeros((1, 1)), zeros)
    found = fixed_point._with_integrators(form)
    wanted = given.copy()
    wanted[0, 0] = wanted[3, 3] = 1.0
    np.testing.assert_array_equal(found.A, wanted)
    np.testing.assert_array_equal(form.A, given)
    assert (found.B is zeros, found.form, found.blocks) == (True, "modal", form.blocks)
