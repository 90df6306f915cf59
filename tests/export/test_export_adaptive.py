"""Flight code of an inverse that learns: the kernel's commands, and limits that nothing takes it beyond."""

import math
import subprocess
from dataclasses import replace
from functools import cache
from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest

import designs
from export.test_export_fixed import Compiled, held_extremes
from export.test_export_flight import (  # noqa: F401
    EXACT,
    OFTEN,
    Code,
    bench,
    difference,
    garbage_stays_within_limits,
    held,
    pytestmark,
    spoiled,
)
from learning_loops import CREEP, PLAYS, in_series, loop_of, softened
from microrad.core import kernels
from microrad.export import choice
from microrad.export.flight import c_code, double_run, learning_rounding, learning_run
from microrad.export.flight import operations as operations_module
from microrad.export.flight.fixed import fixed_code, quantisation_text, quantised
from microrad.export.flight.fixed_form import readings
from microrad.export.flight.operations import Operations, fixed_operations, operations
from microrad.export.flight.rounding import UNIT, behind_converter, errors_before_converter, rounding_bound
from microrad.export.linear_part.sections import sections
from microrad.export.records import AdaptiveLaw
from microrad.loop.control import adaptive
from microrad.loop.pointing_loop.loop import with_adaptation
from microrad.mirror.hysteresis import NO_CREEP

SAMPLES = 4000
BOUNDED = 4000 if OFTEN else 500
"""Samples of a run whose bound of rounding is taken: that is 64 runs of them."""


def chosen_to_learn(resolution_v=0.0, learns=True, creep=NO_CREEP, **changes):
    """The choice that `learning` makes a controller of."""
    nominal = loop_of(creep=creep, axes=2)
    nominal = replace(nominal, drive=replace(nominal.drive, drive_resolution_v=resolution_v, **changes))
    made = in_series(nominal)
    made = with_adaptation(made, nominal) if learns else made
    softer = replace(nominal, mirror=loop_of(softened(PLAYS), CREEP, axes=2).mirror)
    scene = replace(designs.chosen("PI + inverse in series").scene, loop=softer)
    return replace(designs.chosen("PI + inverse in series"), scene=scene, controller=made)


@cache
def learning(resolution_v=0.0, learns=True, samples=SAMPLES, **changes):
    """The controller of two axes as it flies, and its run on a mirror that has softened and creeps.

    ``changes`` are of the drive, and ``creep`` is what the inverse knows of it.
    """
    chosen = chosen_to_learn(resolution_v, learns, **changes)
    return choice.flight_controller(chosen), choice.vectors(chosen, samples)


@pytest.mark.promise("export-18", "export-19")
def test_it_is_the_kernel_while_it_learns(tmp_path):
    of, vectors = learning()
    assert [each.name for each in of.inputs] == ["optical_error_rad", "gauge_rad", "reference_rad"]
    code = Code(tmp_path, of)
    off, counters = difference(code, vectors)
    print(f"off by {off:.2g} of the largest command")
    assert 0.0 < off < EXACT
    assert (counters.rejected, counters.faults) == (0, 0)
    frozen = replace(of, adaptation=replace(of.adaptation, settings=no_learning(of.adaptation.settings)))
    assert difference(Code(tmp_path / "frozen", frozen), vectors)[0] > 1e-3  # it learnt


@pytest.mark.endurance
def test_it_is_the_kernel_over_1e5_samples(tmp_path):
    of, vectors = learning(samples=100_000)
    assert 0.0 < difference(Code(tmp_path, of), vectors)[0] < EXACT


def test_it_is_the_kernel_where_a_weight_is_held_at_its_least(tmp_path, monkeypatch):
    monkeypatch.setattr(adaptive, "LEAST_WEIGHT", 0.9)
    of, vectors = learning.__wrapped__()
    assert difference(Code(tmp_path, of), vectors)[0] < EXACT
    lower = of.adaptation.settings.copy()
    lower[:, kernels.LEAST_WEIGHT] = 0.0
    other = replace(of, adaptation=replace(of.adaptation, settings=lower))
    assert difference(Code(tmp_path / "lower", other), vectors)[0] > 1e-4


def no_learning(settings):
    still = settings.copy()
    still[:, kernels.GAIN] = still[:, kernels.SHARE] = 0.0
    return still


# ------------------------------------------------------------------------------------------------ single precision


@cache
def bounded(samples=BOUNDED, **which):
    """A controller with its run, and the bound of single precision there."""
    of, vectors = learning(samples=samples, **which)
    return of, vectors, rounding_bound(of, sections(of), vectors)


def stray(folder, of, vectors, bound):
    """The code in single precision, and the most that it is off the kernel, V."""
    code = Code(folder, of, "single", bound=bound)
    return code, difference(code, vectors)[0] * np.max(np.abs(vectors.commands))


def test_the_run_in_double_is_the_kernels():
    of, vectors = learning()
    found = double_run.run_in_double(of, sections(of), vectors.inputs).free
    assert 0.0 < np.max(np.abs(found - vectors.commands)) < EXACT * np.max(np.abs(vectors.commands))


@pytest.mark.promise("export-18", "export-19")
def test_single_precision_stays_within_its_bound_while_it_learns(tmp_path):
    of, vectors, bound = bounded()
    code, found = stray(tmp_path, of, vectors, bound)
    print(f"strays by {found:.2g} V, and its bound is {bound.command_v:.2g} V")
    assert 0.03 * bound.command_v < found < bound.command_v < 1e-4
    assert found < 5e-6 * np.max(np.abs(vectors.commands))
    status, numbers, _ = bench(code, vectors, passes=0)
    assert (status, numbers["faults"]) == (0, 0)
    assert numbers["bound_v"] == pytest.approx(bound.command_v, rel=1e-5)
    assert "6 times the rms of 64 runs with random roundings" in bound.words
    joined = " ".join(code.files["flown.h"].replace("\n *", " ").split())
    assert f"within {bound.command_v:.3g} V of double precision over {BOUNDED} recorded samples" in joined
    assert "It is 6 times the rms of what 64 runs with random roundings are off." in joined


@pytest.mark.endurance
def test_single_precision_stays_within_its_bound_over_1e5_samples(tmp_path):
    of, vectors, bound = bounded(samples=100_000)
    _, found = stray(tmp_path, of, vectors, bound)
    print(f"strays by {found:.2g} V, and its bound is {bound.command_v:.2g} V")
    assert 0.03 * bound.command_v < found < bound.command_v < 5e-3


KINDS = {
    "a converter": {"resolution_v": 0.305e-3},
    "an inverse that takes off creep": {"creep": CREEP},
    "clipped commands": {"minimum_v": -0.4, "maximum_v": 0.4},
}


@pytest.mark.parametrize("kind", KINDS)
def test_the_bound_holds_with(kind, tmp_path):
    of, vectors, bound = bounded(samples=600, **KINDS[kind])
    vectors = c_code.within_limits(of, vectors)
    assert (vectors.saturated > 40) == (kind == "clipped commands")
    _, found = stray(tmp_path, of, vectors, bound)
    assert 0.0 < found <= bound.command_v <= (2.01 * of.resolution_v or 1e-4)


def test_the_bound_is_that_of_every_sample(tmp_path):
    """Ahead of the converter and the clip; it holds from the first sample on, not by its largest alone."""
    of, vectors = learning()
    first = replace(vectors, inputs=vectors.inputs[:BOUNDED], commands=vectors.commands[:BOUNDED])
    bound = errors_before_converter(of, sections(of), first)
    off = np.abs(Code(tmp_path, of, "single").replay(vectors.inputs) - vectors.commands)
    assert np.all(off[:BOUNDED] <= bound + 4.0 * UNIT * np.abs(first.commands))
    assert np.max(off[2000:]) > 2.0 * np.max(off[:500])  # it adds up what it learns from


@pytest.mark.promise("export-19")
def test_roundings_are_as_large_as_they_can_be_and_up_as_often_as_down():
    rounded = learning_run.Roundings(UNIT, 64)
    x = np.full((4000, 64), 3.0)
    off = (rounded(x) - x) / (UNIT * 3.0)
    assert np.allclose(np.abs(off), 1.0, rtol=1e-6)
    assert abs(np.mean(off)) < 0.01
    assert np.max(np.abs(np.corrcoef(off.T) - np.eye(64))) < 0.1  # each run for itself
    total = rounded.total(x, -x, operations=4)
    assert np.allclose(np.abs(total), 2.0 * UNIT * 6.0)
    assert np.array_equal(learning_run.Roundings(0.0, 64)(x), x)


# ------------------------------------------------------------------------------------------------ fixed point


@cache
def whole():
    """A controller with a converter, its run, and it in fixed point."""
    of, vectors = learning(0.305e-3, samples=BOUNDED)
    return of, c_code.within_limits(of, vectors), quantised(of, sections(of), vectors)


@cache
def free():
    """The same without a converter: a command is a word."""
    of, vectors = learning(samples=BOUNDED)
    return of, vectors, quantised(of, sections(of), vectors)


@pytest.mark.promise("export-18", "export-20")
@pytest.mark.promise("export-14")
def test_in_fixed_point_it_stays_within_its_report(tmp_path):
    of, vectors, fixed = whole()
    r = fixed.report
    print(f"whole numbers add {r.error_v:.2g} V, what learns in single precision up to {r.inverse_v:.2g} V")
    between_v = 1e-5 if OFTEN else 1e-6  # what learns adds up its roundings from sample to sample
    assert 1e-8 < r.error_v < between_v < r.inverse_v < 1e-4
    assert r.bound_v <= 2.01 * of.resolution_v
    assert "The inverse, in single precision, adds up to" in quantisation_text(fixed)
    for file, text in fixed_code(of, sections(of), fixed, "flown").items():
        (tmp_path / file).write_text(text)
    (tmp_path / "vectors.csv").write_text(c_code.vectors_text(of, vectors))
    for target in ("check", "sanitized") if OFTEN else ("sanitized",):
        command = ["make", "-s", target, "CC=gcc", "PASSES=0", *(["CFLAGS=-std=c99 -O1"] if target != "check" else [])]
        done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
        told = {line.split()[0]: float(line.split()[1]) for line in done.stdout.splitlines() if len(line.split()) == 2}
        assert (done.returncode, done.stderr) == (0, ""), done.stdout
        assert 0.0 < told["largest_difference_v"] <= r.bound_v
        assert (told["rejected"], told["faults"], told["overflowed"]) == (0, 0, 0)


def test_in_fixed_point_it_stays_near_without_a_converter(tmp_path):
    """What it is off is not hidden by a count."""
    of, vectors, fixed = free()
    read, count = readings(fixed, vectors.inputs), np.exp2(-np.array(fixed.input_scale))
    assert np.all(np.abs(count * read - vectors.inputs) <= 0.5 * count * (1.0 + 1e-9))
    found, _ = Compiled(of, sections(of), fixed, tmp_path).run(read, np.zeros((BOUNDED, 2), int), "steps")
    off = np.max(np.abs(found * 2.0 ** -fixed.output_scale[0] - vectors.commands))
    print(f"strays by {off:.2g} V, and its bound is {fixed.report.bound_v:.2g} V")
    assert 0.03 * fixed.report.bound_v < off < fixed.report.bound_v < 1e-4


def test_no_readings_take_it_beyond_its_limits_in_fixed_point(tmp_path):
    of, vectors, fixed = whole()
    recorded = readings(fixed, vectors.inputs)[:500]
    rng, width = np.random.default_rng(6), recorded.shape[1]
    every = np.vstack([recorded, held_extremes(rng, 1500, width), recorded])
    found, (saturated, _) = Compiled(of, sections(of), fixed, tmp_path).run(every, np.zeros((2500, 2), int), "steps")
    assert np.max(np.abs(found)) * of.resolution_v <= of.maximum_v
    assert saturated > 100
    assert len(np.unique(found[-300:, 0])) > 50  # it moves again


# ------------------------------------------------------------------------------------------------ garbage and upsets


@pytest.mark.promise("export-18")
@pytest.mark.parametrize("precision", [pytest.param("double", marks=pytest.mark.endurance), "single"])
def test_garbage_does_not_take_it_beyond_its_limits_nor_what_it_learns(precision, tmp_path):
    of, vectors = learning(0.305e-3)
    vectors = replace(vectors, inputs=vectors.inputs[:800], commands=vectors.commands[:800])
    code = Code(tmp_path, of, precision)
    bad = garbage_stays_within_limits(code, of, vectors)
    state = code.begin()
    code.replay(bad, state)
    assert len(np.unique(code.replay(vectors.inputs[:500], state)[:, 0])) > 50  # it moves again


NUMBERS = {
    "double": (np.nan, np.inf, -np.inf, 1e300, -1e300, 1e11),
    "single": (np.nan, np.inf, -np.inf, 3e38, -3e38, 1e11),
}


@pytest.mark.promise("export-18")
@pytest.mark.parametrize(("precision", "number"), [(each, x) for each, numbers in NUMBERS.items() for x in numbers])
def test_whatever_an_upset_leaves_in_what_it_learns_commands_stay_within_the_limits(precision, number, tmp_path):
    of, vectors = learning()
    code, rng = Code(tmp_path, of, precision), np.random.default_rng(7)
    for _ in range(60):
        state = code.begin()
        code.replay(vectors.inputs[:200], state)
        numbers = np.frombuffer(state, dtype=code.number, count=len(state) // np.dtype(code.number).itemsize)
        numbers[rng.integers(0, len(numbers))] = number
        found = code.replay(vectors.inputs[200:600], state)
        assert np.all(np.isfinite(found))
        assert np.max(np.abs(found)) <= of.maximum_v
        assert np.ptp(found[-100:, 0]) > 0.0


def test_the_operations_are_those_of_the_worst_phase_of_a_cycle():
    (of, _), (frozen, _) = learning(), learning(learns=False)
    found, without = (operations(each, sections(each), "double") for each in (of, frozen))
    one = replace(of, adaptation=replace(of.adaptation, settings=with_cycle(of.adaptation.settings, 8)))
    assert operations(one, sections(one), "double") == found  # a longer pause costs nothing
    assert found.divisions == without.divisions + 2  # an actuator judges while the other one learns
    assert found.multiplications > without.multiplications + 10 * 4


def with_cycle(settings, samples):
    found = settings.copy()
    found[:, kernels.CYCLE] = samples
    return found


@pytest.mark.promise("export-20")
def test_in_fixed_point_it_costs_what_learns_beside():
    of, _, fixed = whole()
    (frozen, vectors) = learning(0.305e-3, learns=False, samples=500)
    without = fixed_operations(frozen, quantised(frozen, sections(frozen), vectors))
    found = fixed_operations(of, fixed)
    assert found.conversions == without.conversions + 2  # the readings' errors
    more = operations(of, sections(of), "single").divisions - operations(frozen, sections(frozen), "single").divisions
    assert found.single.divisions == without.single.divisions + more == without.single.divisions + 2


@pytest.mark.promise("export-18")
def test_the_header_says_what_learns():
    of, _ = learning()
    files = c_code.flight_code(of, sections(of), "flown", "double")
    assert "10 play operator(s) that learn" in files["flown.h"]
    assert "uint32_t fallbacks;" in files["flown.h"]


def test_the_bound_of_a_command_in_fixed_point_adds_what_either_part_is_off():
    """Whole numbers and the inverse in single precision; there is no converter behind them."""
    of, _, fixed = free()
    r = fixed.report
    larger, both = behind_converter(of, np.array([max(r.error_v, r.inverse_v), r.error_v + r.inverse_v]))
    assert (1.0 + 1e-6) * larger < r.bound_v <= (1.0 + 1e-9) * both


# ----------------------------------------------------------------------------------- laws and roundings, each by itself
def test_each_actuators_law_has_its_own_row_and_plays_rounded_to_the_given_precision():
    columns = {
        "gain": kernels.GAIN,
        "share": kernels.SHARE,
        "dead_zone": kernels.DEAD_ZONE,
        "speed": kernels.SPEED,
        "least_size": kernels.LEAST_SIZE,
        "least_travel": kernels.LEAST_TRAVEL,
        "most_weight": kernels.MOST_WEIGHT,
        "offset_limit": kernels.OFFSET_LIMIT,
    }
    every = [*columns.values(), kernels.CYCLE, kernels.DELAY, kernels.KEEP, kernels.LEAST_WEIGHT]
    settings = 0.1 + 0.01 * np.arange(2.0 * (max(every) + 1)).reshape(2, -1)
    settings[:, kernels.CYCLE], settings[:, kernels.DELAY] = (20.0, 30.0), (3.0, 4.0)
    weight, threshold = np.array([0.1, 0.2, 0.3, 0.7, 0.9]), np.array([0.0, 0.3, 0.0, 0.1, 0.6])
    of = AdaptiveLaw(settings, threshold, weight, np.array([0, 2, 5]))
    for number in (np.float64, np.float32):
        for row, own, found in zip(settings, (slice(0, 2), slice(2, 5)), learning_run.laws(of, number), strict=True):
            for name, column in columns.items():
                assert getattr(found, name) == float(number(row[column])), name
            assert (found.cycle, found.delay) == (row[kernels.CYCLE], row[kernels.DELAY])
            assert found.forgotten == float(number(1.0 - row[kernels.KEEP]))
            first = float(number(row[kernels.LEAST_WEIGHT]))
            assert found.least.ravel().tolist() == [first, *[0.0] * (len(weight[own]) - 1)]
            assert found.weight.ravel().tolist() == [float(number(x)) for x in weight[own]]
            rounded = [float(number(x)) for x in threshold[own]]
            assert found.gaps.ravel().tolist() == [b - a for a, b in pairwise(rounded)]
            assert found.weight.dtype == found.gaps.dtype == np.float64
    assert learning_run.laws(of)[1].weight.tolist() == [[0.3], [0.7], [0.9]]


def test_sums_and_products_are_off_by_the_sizes_of_their_parts_and_the_root_of_the_operations():
    unit = 2.0**-10
    rounded, exactly = learning_run.Roundings(unit, 2), learning_run.Roundings(0.0, 2)
    a, b = np.array([[3.0, -1.0], [2.0, 5.0]]), np.array([[-3.0, 4.0], [0.5, 0.0]])
    row, terms = np.array([[1.0, -2.0], [0.0, 4.0], [3.0, 1.0]]), np.array([[4.0], [9.0], [1.0]])
    beyond, sizes = np.array([[5.0, 4.0], [2.0, 5.0]]), np.array([[5.0, 6.0], [2.0, 5.0]])
    for found, exact, value, size in (
        (rounded(a, 9), exactly(a, 9), a, 3.0 * np.abs(a)),
        (rounded.total(a, b), exactly.total(a, b), a + b, math.sqrt(2.0) * (np.abs(a) + np.abs(b))),
        (rounded.total(a, b, -a, operations=16), exactly.total(a, b, -a), b, 4.0 * (2.0 * np.abs(a) + np.abs(b))),
        (rounded.product(row, a, terms), exactly.product(row, a, terms), row @ a,
         np.array([[2.0], [3.0], [1.0]]) * (np.abs(row) @ np.abs(a))),
        (rounded.totals_from_beyond(a, 4), exactly.totals_from_beyond(a, 4), beyond, 2.0 * (0.0 + sizes)),
    ):  # fmt: skip
        np.testing.assert_allclose(exact, [[5.0, 4.0], [2.0, 5.0]] if value is beyond else value, rtol=0, atol=1e-15)
        np.testing.assert_allclose(np.abs(found - value), unit * size, rtol=1e-12)


@pytest.mark.parametrize("linear", [True, False])
def test_a_bound_of_what_learns_is_six_times_the_rms_of_its_runs_by_sample_and_actuator(monkeypatch, linear):
    """The readings are rounded to single precision; where the linear part is exact, its outputs come instead."""
    inputs, outputs = np.array([[0.1, 2.0], [0.3, 4.0]]), np.array([[7.0, 8.0, 9.0], [10.0, 11.0, 12.0]])
    free, asked = np.array([[1.0, -2.0], [3.0, 5.0]]), []
    off = np.array([[3.0, -3.0, 3.0, 3.0], [1.0, -7.0, 7.0, -1.0]])

    class Code:
        def __init__(self, of, form):
            asked.append((of, form))

        def step(self, readings):
            asked.append(readings.tolist())
            return free[len(asked) - 2][:, None] + off * (len(asked) - 1)

        beside = step

    monkeypatch.setattr(learning_rounding, "_Single", Code)
    run = SimpleNamespace(free=free, outputs=outputs)
    found = learning_rounding.learning_errors("of", "form", run, inputs if linear else None)
    np.testing.assert_allclose(found, [[18.0, 30.0], [36.0, 60.0]])
    readings_ = inputs.astype(np.float32).astype(float) if linear else outputs
    assert asked == [("of", "form"), *readings_.tolist()]


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("beside", [False, True])
def test_the_runs_of_a_bound_are_those_in_double_where_nothing_is_rounded(monkeypatch, kind, beside):
    of, vectors = learning(samples=1500, **KINDS[kind])
    monkeypatch.setattr(learning_rounding, "UNIT", 0.0)
    monkeypatch.setattr(learning_rounding, "RUNS", 2)
    monkeypatch.setattr(learning_rounding, "_in_single", lambda x: np.asarray(x, dtype=float))
    monkeypatch.setattr(learning_rounding, "laws", lambda law, number: learning_run.laws(law))
    form, inputs = sections(of), vectors.inputs[:400]
    run = double_run.run_in_double(of, form, inputs)
    found = learning_rounding.learning_errors(of, form, run, None if beside else inputs)
    assert found.shape == (400, 2)
    assert np.max(found) < 1e-9 * np.max(np.abs(run.free))


def law_of(*plays):
    """Actuators with so many plays each, and rows of settings of which no two numbers are alike."""
    settings = 0.1 + 0.01 * np.arange(float(len(plays) * (max(SETTINGS.values()) + 1))).reshape(len(plays), -1)
    settings[:, kernels.CYCLE], settings[:, kernels.DELAY] = 20.0, 3.0
    count = sum(plays)
    return AdaptiveLaw(settings, np.zeros(count), np.arange(1.0, count + 1.0), np.cumsum([0, *plays]))


SETTINGS = {
    name: getattr(kernels, name.upper())
    for name in (
        *("cycle", "delay", "gain", "share", "keep", "dead_zone", "speed", "least_size", "least_travel"),
        *("least_weight", "most_weight", "offset_limit"),
    )
}


@pytest.mark.parametrize(
    ("plays", "counts"),
    [
        ((5, 2), Operations(multiplications=36 + 4 + 7, additions=87 + 14 + 28, divisions=2, comparisons=20 + 6 + 14)),
        ((2, 5), Operations(multiplications=34 + 4 + 7, additions=81 + 14 + 28, divisions=2, comparisons=20 + 6 + 14)),
    ],
)
def test_of_two_actuators_the_second_learns_its_first_play_while_the_first_one_judges(plays, counts):
    """Judging costs 4 n + 14 products and 12 n + 21 sums; a sample later a play takes 2 and 6 to learn."""
    assert operations_module._learning(law_of(*plays), 2) == counts


def test_the_code_gets_the_slopes_and_settings_of_each_actuator():
    law = law_of(2, 3, 1)
    found = c_code._adaptive_values(law)
    assert found["slopes"].tolist() == [1.0, 3.0, 3.0, 7.0, 12.0, 6.0]
    assert (found["learners"], found["cycle"], found["reading_delay"]) == (6, 20, 3)
    assert found["adaptive"] is law and (found["plays"], found["direct"]) == (0, False)
    own = {name: column for name, column in SETTINGS.items() if name not in ("cycle", "delay", "keep")}
    assert set(found["law"]) == {*own, "forgotten"} == set(found["settings"])
    for name, column in own.items():
        assert found["law"][name].tolist() == law.settings[:, column].tolist(), name
    assert found["law"]["forgotten"].tolist() == (1.0 - law.settings[:, kernels.KEEP]).tolist()
    assert found["shares"] == {
        "TAKE_UP": kernels.TAKE_UP,
        "KEEP_UP": kernels.KEEP_UP,
        "SUSPECT": kernels.SUSPECT,
    }
    assert (found["bound_sigmas"], found["bound_runs"]) == (6.0, 64)
