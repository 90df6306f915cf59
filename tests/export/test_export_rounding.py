"""Single precision stays within the bound that the export states: held against a twin in numpy's float32 and against C.

The twin takes the operations of the generated code one by one, in its order, with Kahan's sums where it has them.
"""

import math
import shutil
import subprocess
from dataclasses import replace
from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest

import designs
from drawn import plain as six_digits
from microrad.core import kernels, lti
from microrad.core.kernels.loop import inverse_drive
from microrad.export.flight import double_run, learning_rounding, rounding
from microrad.export.flight.c_code import flight_code, vectors_text
from microrad.export.linear_part.sections import compensated_states, sections
from microrad.export.records import FlightController, InverseLaw, Origin, Signal, Vectors
from microrad.loop.pointing_loop.kernel_arrays import forward_arrays
from microrad.loop.pointing_loop.loop import ForwardHysteresis
from microrad.mirror.hysteresis import PrandtlIshlinskii

SAMPLES = 1000
f = np.float32
ONE, TOLERANCE, TRIALS = f(1.0), f(1e-6), 256

SHIPPED = ("PI + inverse", "PI + inverse in series", "LQG", "PID + inverse")


@cache
def shipped(name):
    """A controller of the shipped mission, its sections and a recorded run."""
    of, v = designs.flown(name, SAMPLES)
    return of, sections(of), v


# ------------------------------------------------------------------------------------------------------------- the twin
def times(matrix, numbers, total):
    """total + matrix numbers, column by column: in each row the order of the code's terms."""
    for column, number in zip(matrix.T, numbers, strict=True):
        total = total + column * number
    return total


class Element:
    """A Bouc-Wen element as {name}_hysteresis.h has it."""

    def __init__(self, row):
        (self.d1, self.d2, self.epsilon, self.delta, self.alpha, self.beta, self.limit, self.bias, self.gamma, self.eta,
         self.power, self.per_size) = (f(x) for x in row)  # fmt: skip
        self.h = f(0.0)

    def relaxed(self, h, forcing, decay):
        share = ONE if decay == 0.0 else -np.expm1(-decay) / decay
        return h + (forcing - decay * h) * share

    def linear(self, h, forcing, positive, negative):
        above = h > 0.0 or (h == 0.0 and forcing > 0.0)
        decay, other = (positive, negative) if above else (negative, positive)
        end = self.relaxed(h, forcing, decay)
        if h * forcing >= 0.0 or h * end > 0.0:
            return end
        fraction = -h / forcing if decay == 0.0 else np.log1p(-decay * h / forcing) / decay
        rest = ONE - fraction if fraction < 1.0 else f(0.0)
        return self.relaxed(f(0.0), forcing * rest, other * rest)

    def slope(self, h, forcing, positive, negative):
        decay = positive if h > 0.0 else negative
        return forcing - decay * h * np.power(abs(h) * self.per_size, self.power)

    def integrated(self, h, forcing, positive, negative):
        largest = max(abs(positive), abs(negative))
        step = ONE / (ONE + largest * (self.power + ONE) * max(ONE, abs(h) * self.per_size))
        done = f(0.0)
        rows = [[], [1 / 5], [3 / 40, 9 / 40], [44 / 45, -56 / 15, 32 / 9],
                [19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729],
                [9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656],
                [35 / 384, 0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84]]  # fmt: skip
        wrong = [71 / 57600, 0, -71 / 16695, 71 / 1920, -17253 / 339200, 22 / 525, -1 / 40]
        for _ in range(TRIALS):
            step, k, at = min(step, ONE - done), [], h
            for row in rows:
                at = h + step * sum((f(w) * each for w, each in zip(row, k, strict=True)), f(0.0))
                k.append(self.slope(at, forcing, positive, negative))
            error = abs(step * sum((f(w) * each for w, each in zip(wrong, k, strict=True)), f(0.0)))
            error = error * (self.per_size / TOLERANCE)
            if error <= 1.0:
                done, h = done + step, at
            if done >= 1.0:
                return h
            step = step * min(f(5.0), max(f(0.2), f(0.9) * np.power(error + f(1e-12), f(-0.2))))
        raise AssertionError("the trials ran out")

    def drive(self, target, before, rate):
        travel, rate = (target - before) / self.d1, min(max(rate / self.d1, -self.limit), self.limit)
        forcing = self.epsilon * np.exp(self.delta * abs(rate)) * travel
        size = abs(travel)
        positive = (self.alpha + self.gamma) * size + (self.beta + self.eta) * travel
        negative = (self.alpha - self.gamma) * size + (self.eta - self.beta) * travel
        step = self.linear if self.power == 0.0 else self.integrated
        self.h = step(self.h, forcing, positive, negative)
        return (target - self.h + self.d1 * self.bias) / (self.d1 * np.exp(-self.d2 * rate)) - self.bias


class Single:
    """The generated code in single precision."""

    def __init__(self, of, form):
        self.of, self.n = of, of.actuators
        self.slow = np.array(compensated_states(form), dtype=bool)
        step = form.A - np.diag(self.slow.astype(float))
        self.A, self.B, self.L, self.C, self.D = (m.astype(f) for m in (step, form.B, form.L, form.C, form.D))
        self.x, self.rest = np.zeros(form.order, f), np.zeros(form.order, f)
        self.target = np.zeros(self.n, f)
        if (law := of.inverse) is not None:
            self.law = law
            self.elements = [Element(row) for row in law.bouc_wen]
            self.play, self.lag = np.zeros(law.play_weight.size, f), np.zeros(law.lag_keep.size, f)
            self.lag_rest = np.zeros_like(self.lag)
            self.direct, self.threshold, self.weight = (
                a.astype(f) for a in (law.direct, law.play_threshold, law.play_weight)
            )
            self.widening = law.widening[:, 0].astype(f)
            self.limit = np.minimum(law.widening[:, 1], np.finfo(f).max).astype(f)
            self.share, self.creep = (1.0 - law.lag_keep).astype(f), law.lag_weight.astype(f)

    def kahan(self, total, rest, change):
        whole = change - rest
        new = total + whole
        return new, (new - total) - whole

    def inverse(self, y):
        law, n, before = self.law, self.n, self.target
        target = y[n : 2 * n].copy()
        for j, a in enumerate(law.lag_actuator.astype(int)):
            target[a] = target[a] - self.creep[j] * self.lag[j]
        rate = (target - before) / f(self.of.period_s) if law.by_difference else y[2 * n :]
        drive = self.direct * target
        for element, a in zip(self.elements, law.bouc_wen_actuator.astype(int), strict=True):
            drive[a] = drive[a] + element.drive(target[a], before[a], rate[a])
        widened = self.widening * np.minimum(np.abs(rate), self.limit)
        for j, a in enumerate(law.play_actuator.astype(int)):
            half = self.threshold[j] + widened[a] if self.threshold[j] > 0.0 else f(0.0)
            self.play[j] = min(max(self.play[j], target[a] - half), target[a] + half)
            drive[a] = drive[a] + self.weight[j] * self.play[j]
        for j, a in enumerate(law.lag_actuator.astype(int)):
            change = self.share[j] * (drive[a] - self.lag[j])
            self.lag[j], self.lag_rest[j] = self.kahan(self.lag[j], self.lag_rest[j], change)
        self.target = target
        return drive

    def step(self, reading):
        """Commands ahead of the clip, and behind the converter."""
        m = reading.astype(f)
        y = times(self.D, m, times(self.C, self.x, np.zeros(self.C.shape[0], f)))
        v = y[: self.n] if self.of.inverse is None else y[: self.n] + self.inverse(y)
        low, high = f(self.of.minimum_v), f(self.of.maximum_v)
        clipped = np.minimum(np.maximum(v, low), high)
        new = times(self.L, clipped - v, times(self.B, m, times(self.A, self.x, np.zeros_like(self.x))))
        total, rest = self.kahan(self.x, self.rest, new)
        self.x, self.rest = np.where(self.slow, total, new), np.where(self.slow, rest, f(0.0))
        if self.of.resolution_v == 0.0:
            return v, clipped
        r = f(self.of.resolution_v)
        edge = (
            (math.floor(self.of.maximum_v / self.of.resolution_v + 1e-6) * self.of.resolution_v) if high < 1e9 else high
        )
        return v, np.minimum(np.floor(clipped / r + f(0.5)) * r, f(edge))


def single_run(of, form, inputs):
    twin = Single(of, form)
    with np.errstate(under="ignore"):
        found = [twin.step(row) for row in inputs]
    return np.array([v for v, _ in found], dtype=float), np.array([c for _, c in found], dtype=float)


# ----------------------------------------------------------------------------------------------------- shipped mission
@pytest.mark.parametrize("name", SHIPPED)
def test_the_run_in_double_is_the_recorded_one(name):
    of, form, v = shipped(name)
    found = double_run.run_in_double(of, form, v.inputs)
    r = of.resolution_v
    commands = np.floor(np.clip(found.free, of.minimum_v, of.maximum_v) / r + 0.5) * r
    assert np.max(np.abs(commands - v.commands)) <= 1e-12
    assert np.max(np.abs(commands)) > 0.5


@pytest.mark.promise("export-14", "export-15")
@pytest.mark.parametrize("name", SHIPPED)
def test_single_precision_stays_within_its_bound(name):
    of, form, v = shipped(name)
    bound = rounding.rounding_bound(of, form, v)
    ahead = rounding.errors_before_converter(of, form, v)
    free, commands = single_run(of, form, v.inputs)
    wrong = np.abs(free - double_run.run_in_double(of, form, v.inputs).free)
    assert np.all(wrong <= ahead)
    assert np.max(ahead) <= 100.0 * np.max(wrong)
    difference = np.max(np.abs(commands - v.commands))
    assert difference <= bound.command_v <= 2.01 * of.resolution_v
    assert bound.samples == SAMPLES


@pytest.mark.parametrize("name", ["PI + inverse in series", "LQG"])
def test_the_compiled_code_stays_within_it(name, tmp_path):
    if not shutil.which("gcc"):
        pytest.skip("no gcc here")
    of, form, v = shipped(name)
    bound = rounding.rounding_bound(of, form, v)
    for file, text in flight_code(of, form, "single", "single", bound).items():
        (tmp_path / file).write_text(text)
    (tmp_path / "vectors.csv").write_text(vectors_text(of, v))
    flags = "-std=c99 -O2 -Wall -Wextra -Werror -pedantic"
    subprocess.run(
        ["gcc", *flags.split(), "-o", "bench", "single.c", "single_bench.c", "-lm"], cwd=tmp_path, check=True
    )
    done = subprocess.run(["./bench", "vectors.csv"], cwd=tmp_path, capture_output=True, text=True, check=False)
    told = dict(line.split() for line in done.stdout.splitlines())
    assert done.returncode == 0, done.stdout
    assert 0.0 <= float(told["largest_difference_v"]) <= bound.command_v
    assert float(told["bound_v"]) == pytest.approx(bound.command_v, rel=1e-5)
    assert float(told["peak_command_v"]) == pytest.approx(np.max(np.abs(v.commands)))


@pytest.mark.promise("export-14")
def test_what_integrators_lose_grows_with_the_samples():
    of, form, v = shipped("PI + inverse")
    half = Vectors(*(getattr(v, key)[: SAMPLES // 2] for key in ("inputs", "commands")), 0, 0)
    whole, early = rounding.rounding_bound(of, form, v), rounding.rounding_bound(of, form, half)
    assert whole.per_sample_v > 0.0 < early.per_sample_v
    ahead = np.max(rounding.errors_before_converter(of, form, v))
    assert np.max(rounding.errors_before_converter(of, form, half)) < ahead
    assert f"{whole.command_v:.3g} V of double over these {SAMPLES} samples" in whole.words
    assert f"grows by {whole.per_sample_v:.2g} V a sample." in whole.words


# ---------------------------------------------------------------------------------------------------- other controllers
PERIOD_S = 2e-4


def one_axis(system, *, windup=0.0, inverse=None, limit_v=math.inf, resolution_v=0.0):
    return FlightController(
        name="a design",
        origin=Origin("a mission", "0" * 64, "a mirror"),
        period_s=PERIOD_S,
        inputs=(Signal("reading_rad", system.B.shape[1], "rad", "reading", 0.1),),
        actuators=1,
        system=system,
        anti_windup=np.full((system.order, 1), windup),
        inverse=inverse,
        minimum_v=-limit_v,
        maximum_v=limit_v,
        resolution_v=resolution_v,
        bias_v=0.0,
        margins=(),
    )


def vectors_of(inputs):
    nothing = np.zeros((len(inputs), 1))
    return Vectors(inputs, nothing, 0, 0)


def integral(gain=3000.0, step=300.0):
    return lti.StateSpace(np.eye(1), np.array([[step]]), np.eye(1), np.array([[gain]]))


def law(elements=(), *, plays=(), widening=0.0, creep=(), direct=0.0, by_difference=True):
    zeros = np.zeros
    return InverseLaw(
        direct=np.array([direct]),
        bouc_wen=kernels.bouc_wen_rows(elements),
        bouc_wen_actuator=zeros(len(elements), np.uint64),
        play_threshold=np.array([r for r, _ in plays], dtype=float),
        play_weight=np.array([w for _, w in plays], dtype=float),
        play_actuator=zeros(len(plays), np.uint64),
        widening=np.array([[widening, 0.02]]),
        lag_keep=np.array([math.exp(-PERIOD_S / tau) for _, tau in creep]),
        lag_weight=np.array([w for w, _ in creep]),
        lag_actuator=zeros(len(creep), np.uint64),
        by_difference=by_difference,
    )


PAPER = (0.089e-3, -2.96e-7, -0.048e-3, 4.7e-4, 38.421, 34.635, 3770.0, 6.0)
STEEP = (0.089e-3, -2.96e-7, -0.022e-3, 4.7e-4, 2.4, 0.6, 20.0, 6.0, 0.3, -0.2)
POWER = (*STEEP, 0.6, 2.4 / 0.022e-3)
PLAYS = {"plays": ((0.0, 900.0), (2e-5, -500.0), (1e-4, -200.0)), "direct": 12000.0}
CREEP = {"creep": ((2e-6, 0.01), (1e-6, 3.0))}

LAWS = {
    "Bouc-Wen": law((PAPER,)),
    "asymmetric, rate clamped": law((STEEP,)),
    "exponent 1.6": law((POWER,)),
    "plays": law(**PLAYS),
    "widening plays with creep": law(**PLAYS, **CREEP, widening=1e-3),
    "two elements, plays and creep": law((PAPER, STEEP), **PLAYS, **CREEP),
    "creep that amplifies": law(direct=12000.0, creep=((-0.85 / 12000.0, 1e-3),)),
    "creep that amplifies through a play": law(plays=((0.0, 12000.0),), creep=((-0.85 / 12000.0, 1e-3),)),
}


def tracking_reference(samples=1500):
    time = PERIOD_S * np.arange(samples)
    noise = 1e-6 * np.random.default_rng(3).standard_normal(samples)
    return (2e-4 * np.sin(2 * np.pi * 15.0 * time) + 4e-5 * np.sin(2 * np.pi * 170.0 * time) + noise)[:, None]


@pytest.mark.parametrize("name", LAWS)
def test_the_bound_holds_for_each_kind_of_inverse(name):
    system = lti.StateSpace(np.eye(1), np.array([[0.5]]), np.array([[1.0], [0.0]]), np.array([[800.0], [1.0]]))
    of = one_axis(system, inverse=LAWS[name])
    form, v = sections(of), vectors_of(tracking_reference())
    ahead = rounding.errors_before_converter(of, form, v)
    wrong = np.abs(single_run(of, form, v.inputs)[0] - double_run.run_in_double(of, form, v.inputs).free)
    assert np.all(wrong <= ahead)
    assert np.max(ahead) <= 300.0 * np.max(wrong)
    assert np.max(wrong) > 1e-8


@pytest.mark.parametrize("name", LAWS)
def test_the_run_in_double_is_the_kernels(name):
    """The inverse alone, against `kernels.closed_loop`'s."""
    system = lti.StateSpace(np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((2, 0)), np.array([[0.0], [1.0]]))
    of = one_axis(system, inverse=LAWS[name])
    reference = tracking_reference(600)
    found = double_run.Inverse(of, len(reference))
    added = np.array([found.step(np.concatenate([[0.0], row])) for row in reference])
    assert np.max(np.abs(added - kernel_inverse(LAWS[name], reference))) <= 1e-12 * np.max(np.abs(added))
    assert np.max(np.abs(added)) > 1.0


def kernel_inverse(of, reference):
    empty, one, n = np.zeros((0, 0)), np.zeros(1), of.bouc_wen.shape[0]
    loop = kernels.Loop(
        one, one, np.zeros(0), True, 1, 0, empty, empty, empty, empty, empty, empty, np.zeros(1), np.eye(1),
        of.direct, of.bouc_wen, of.bouc_wen_actuator, of.play_threshold, of.play_weight, of.play_actuator, of.widening,
        of.lag_keep, of.lag_weight, of.lag_actuator,
    )  # fmt: skip
    zero = np.zeros(1)
    state = kernels.LoopState(
        zero, zero, zero, zero, zero, np.zeros((1, 2)), np.zeros(n), np.zeros(of.play_weight.size),
        np.zeros(of.lag_keep.size), empty, np.zeros(1, np.int64), np.zeros((1, 2), np.int64), np.zeros(n + 1, np.int64),
    )  # fmt: skip
    found = np.zeros_like(reference)
    inverse_drive(loop, state, reference, PERIOD_S, found)
    return found


def test_a_slow_oscillation_counts_as_what_it_is():
    """A resonance of 1000 samples' decay: |A| element by element grows as 1.4^k and would bound nothing."""
    z = 0.999 * np.exp(0.8j)
    A = np.array([[z.real, -z.imag], [z.imag, z.real]])
    system = lti.StateSpace(A, np.array([[1.0], [0.5]]), np.array([[100.0, 30.0]]), np.zeros((1, 1)))
    of, inputs = one_axis(system), 1e-4 * np.random.default_rng(1).standard_normal((3000, 1))
    form = sections(of)
    ahead = rounding.errors_before_converter(of, form, vectors_of(inputs))
    wrong = np.abs(single_run(of, form, inputs)[0] - double_run.run_in_double(of, form, inputs).free)
    assert np.all(wrong <= ahead)
    assert np.max(ahead) <= 300.0 * np.max(wrong)
    assert np.max(np.linalg.matrix_power(np.abs(A), 100)) > 1e10


def held(of, inputs):
    """Errors ahead of the converter, as bounded and as the twin makes them."""
    form = sections(of)
    ahead = rounding.errors_before_converter(of, form, vectors_of(inputs))
    return ahead, np.abs(single_run(of, form, inputs)[0] - double_run.run_in_double(of, form, inputs).free)


def test_a_memory_that_single_precision_cannot_move_is_bounded():
    """A drive that creeps by less than rounding of h: h stays where it is."""
    law_ = law(((0.089e-3, 0.0, -0.048e-3, 0.0, 38.421, 34.635, 1e9, 0.0),))
    of = one_axis(
        lti.StateSpace(np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((2, 0)), np.array([[0.0], [1.0]])), inverse=law_
    )
    swing, creeping = 2e-4 * np.sin(np.linspace(0.0, np.pi, 300)), 1e-13 * np.arange(1.0, 3001.0)
    ahead, wrong = held(of, np.concatenate([swing, creeping])[:, None])
    assert np.all(wrong <= ahead)
    assert wrong[-1, 0] > 3.0 * wrong[400, 0]
    assert np.max(ahead) < 1e-3


@pytest.mark.parametrize("row", [PAPER, STEEP, POWER, (*PAPER[:6], 400.0, 6.0, 0.4, -0.3)])
def test_no_drive_takes_h_beyond_what_the_element_holds(row):
    """Steps to and fro of all sizes, at rates up to the limit; sweeps to either side come near to it."""
    row = np.array([*row, *[0.0] * (12 - len(row))])
    limit, arrays = row[kernels.RATE_LIMIT], kernels.bouc_wen_rows([tuple(row)])
    grown = row[kernels.EPSILON] * math.exp(row[kernels.DELTA] * limit)
    held_ = rounding._held_at_most(row, abs(grown))
    rng = np.random.default_rng(4)
    wild = rng.normal(size=2000) * 10.0 ** rng.uniform(-4, 1, 2000)
    steps = np.concatenate([np.full(400, 0.5), np.full(400, -0.5), wild])
    h, largest = 0.0, 0.0
    for travel in steps:
        if row[kernels.POWER] == 0.0:
            h = kernels.bouc_wen_step(h, travel, grown, *row[[kernels.ALPHA, kernels.BETA, kernels.GAMMA, kernels.ETA]])
        else:
            h = kernels.bouc_wen_power_step(h, travel, grown, arrays, 0)
        largest = max(largest, abs(h))
    assert 0.9 * held_ < largest <= held_


def test_a_drive_that_rests_does_not_let_the_bound_grow_for_ever():
    """Each sample of a resting reference may turn h round in single precision, but not beyond what it holds."""
    system = lti.StateSpace(np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((2, 0)), np.array([[0.0], [1.0]]))
    of = one_axis(system, inverse=law((PAPER,)))
    inputs = np.concatenate([np.linspace(0.0, 4e-3, 500), np.full(9500, 4e-3)])[:, None]
    ahead = rounding.errors_before_converter(of, sections(of), vectors_of(inputs))[:, 0]
    assert 0.1 < ahead[-1] < 0.6
    assert ahead[-1] - ahead[-2000] < 1e-2 * (ahead[2000] - ahead[1000])


def test_creep_that_amplifies_its_own_errors_is_bounded():
    """A gain of nearly 1 through the lag, and coefficients that round the same way, by half a unit each."""
    near = f(-0.97 / 12000.0)
    weight = 0.51 * float(near) + 0.49 * float(np.nextafter(near, f(0.0)))
    law_ = law(direct=11999.99955, creep=((weight, 1e-3),))
    system = lti.StateSpace(np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((2, 0)), np.array([[0.0], [1.0]]))
    ahead, wrong = held(one_axis(system, inverse=law_), np.full((1200, 1), 1e-4))
    assert np.all(wrong <= ahead)
    assert np.max(ahead) < 300.0 * np.max(wrong)
    assert np.max(wrong) > 1e-4


def test_a_small_difference_of_large_readings_is_bounded():
    of = one_axis(lti.StateSpace(np.zeros((0, 0)), np.zeros((0, 2)), np.zeros((1, 0)), np.array([[3000.0, -2999.9]])))
    reading = 1e-2 * np.sin(np.arange(800.0))[:, None]
    ahead, wrong = held(of, np.hstack([reading, reading]))
    assert np.all(wrong <= ahead)
    assert np.max(wrong) > 1e-7
    assert np.max(ahead) < 30.0 * np.max(wrong)


def test_the_bound_holds_where_commands_are_clipped():
    of = one_axis(integral(), windup=0.09, limit_v=1.0, resolution_v=1e-3)
    inputs = 3.5e-4 * np.sin(2 * np.pi * np.arange(300) / 30.0)[:, None]
    form, found = sections(of), double_run.run_in_double(of, sections(of), inputs)
    assert 20 < np.count_nonzero(found.excess) < 100
    ahead, wrong = held(of, inputs)
    assert np.all(wrong <= ahead)
    assert np.max(wrong) > 0.0
    assert np.max(ahead) < 1e-2
    bound, commands = rounding.rounding_bound(of, form, vectors_of(inputs)), single_run(of, form, inputs)[1]
    in_double = np.floor(np.clip(found.free, -1.0, 1.0) / 1e-3 + 0.5) * 1e-3
    assert np.max(np.abs(commands - in_double)) <= bound.command_v < 0.02
    assert "not bounded" not in bound.words


@pytest.mark.promise("export-15")
def test_errors_that_may_feed_themselves_are_bounded_by_the_limits_alone():
    of = one_axis(integral(), windup=1.5, limit_v=1.0)
    inputs = np.full((400, 1), 8e-4)
    assert np.max(np.abs(double_run.run_in_double(of, sections(of), inputs).free)) < 10.0
    bound = rounding.rounding_bound(of, sections(of), vectors_of(inputs))
    assert bound.command_v == 2.0
    assert "not bounded" in bound.words
    calm = rounding.rounding_bound(of, sections(of), vectors_of(inputs * 1e-3))
    assert calm.command_v < 1e-5
    assert "not bounded" not in calm.words


@pytest.mark.parametrize("samples", [1000, 1001])
def test_a_bound_that_rises_evenly_grows_by_its_rise_a_sample(samples):
    found = rounding._growth(2.5e-9 * np.arange(samples))
    assert found == pytest.approx(2.5e-9, rel=3e-3)


def test_neighbouring_counts_are_a_count_apart():
    of = one_axis(integral(), limit_v=6.0, resolution_v=1e-3)
    little = 4.0 * rounding.UNIT * 6.0
    found = rounding.behind_converter(of, np.array([1e-9, 0.9e-3, 1.1e-3, math.inf]))
    assert found == pytest.approx([1e-3 + little, 1e-3 + little, 2e-3 + little, 12.0], rel=1e-12)
    without = rounding.behind_converter(replace(of, resolution_v=0.0), np.array([1e-9]))
    assert without == pytest.approx([1e-9 + little], rel=1e-12)


def test_impulse_responses_by_doubling_are_the_powers():
    A = np.array([[0.9, 0.2], [-0.1, 0.8]])
    row = np.array([1.0, -2.0])
    found = rounding.responses(row, A, 37)
    assert found.shape == (37, 2)
    assert found == pytest.approx(np.array([row @ np.linalg.matrix_power(A, j) for j in range(37)]), rel=1e-12)


def test_a_slow_lag_of_compensated_sums_errs_by_what_a_step_adds_and_not_by_what_it_holds():
    unit, keep, steps = rounding.UNIT, 1.0 - 1e-7, 200
    law = SimpleNamespace(lag_actuator=np.zeros(1), lag_keep=np.array([keep]))
    run = SimpleNamespace(lag=np.full((steps, 1), 30.0), added=np.zeros((steps, 1)))
    found = rounding._lag_errors(law, run, np.zeros((steps, 1)))[-1, 0]
    assert 0.0 < found <= 1.01 * steps * (1e-7 * 8.0 * unit * 30.0 + 4.0 * unit**2 * 30.0) < 0.1 * unit * 30.0


@pytest.mark.parametrize("powers", [(-0.3, -2.1, -1.7), (0.3, 2.1, -1.7), (-0.3, 2.1, -1.7)])
def test_a_spring_that_softens_errs_in_a_feedforward_as_one_that_hardens_does(powers):
    """Its polynomial in single precision, over a swing beyond its reach of 5 V; turned over it errs by as much."""

    def ahead_of(powers):
        bank = ForwardHysteresis((), (PrandtlIshlinskii((), (), polynomial_rad=powers, reach_v=5.0),), np.ones((1, 1)))
        system = lti.StateSpace(np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((2, 0)), np.array([[0.0], [5e4]]))
        of = replace(one_axis(system), forward=forward_arrays(bank, 1, PERIOD_S))
        return rounding.errors_before_converter(of, sections(of), vectors_of(inputs))[:, 0]

    def volts(number):
        s = np.clip(number(5e4) * number(inputs[:, 0]) / number(5.0), number(-1.0), number(1.0))
        quadratic, signed, cubic = (number(each) for each in powers)
        return (quadratic * s * s + signed * np.abs(s) * s + cubic * s * s * s).astype(float)

    inputs = 1.2e-4 * np.sin(2 * np.pi * np.arange(700) / 333.3)[:, None]
    ahead, wrong = ahead_of(powers), np.abs(volts(np.float32) - volts(np.float64))
    assert np.all(wrong <= ahead)
    assert np.max(wrong) > 1e-8
    assert ahead == pytest.approx(ahead_of(tuple(-each for each in powers)), rel=1e-9, abs=0.0)


# ------------------------------------------------------------------------------------------------ errors part by part
def unlike_bank(**changes):
    """One Bouc-Wen element and two operators, of one and of two plays; the first widens and bends."""
    given = {
        "drives": np.array([[1.0, 0.5, 0.0], [0.0, -0.25, 2.0]]),
        "bouc_wen": np.array([[0.2, -1e-3, -0.25, 2e-3, 0.1, -0.025, 150.0, 6.0, 0.02, -0.01, 0.0, 0.4]]),
        "operator": np.array([[1e-2, 40.0, 0.3, 0.2, -0.1, 4.0], [0.0, np.inf, 0.0, 0.0, 0.0, np.inf]]),
        "play_threshold": np.array([0.25, 0.5, 1.5]),
        "play_weight": np.array([0.25, 0.5, -0.125]),
        "play_start": np.array([0, 1, 3]),
        "step_s": 1e-2,
    }
    return kernels.ForwardBank(**given | changes)


Q = np.array([0.0, 0.5, 1.5, 1.0, -2.0, 6.0])
TRAVEL = np.diff(Q, prepend=0.0)
RATE_ERROR, Q_ERROR = np.linspace(0.25, 1.5, 6), np.array([0.125, 0.25, 0.0625, 0.5, 0.03125, 0.75])


def test_errors_of_operators_have_those_of_their_plays_widening_and_polynomial():
    found = [
        rounding._operator_errors(unlike_bank(), o, np.abs(TRAVEL) / 1e-2, Q, TRAVEL, RATE_ERROR, Q_ERROR)
        for o in (0, 1)
    ]
    assert six_digits(found) == [
        [0.0323633, 0.0738088, 0.070391, 0.168907, 0.132023, 0.45258],
        [0.0781254, 0.156251, 0.156251, 0.312501, 0.312501, 0.468753],
    ]


def test_errors_of_a_memory_are_its_own_where_a_drive_may_have_turned():
    row = unlike_bank().bouc_wen[0].copy()
    with_power = row.copy()
    with_power[kernels.POWER] = 0.5
    h = np.array([0.0, -0.125, -0.25, -0.1, 0.3, -0.75])
    found = [
        rounding._element_errors(each, 1e-2, h, Q, TRAVEL, 1e-3 * RATE_ERROR, 1e-3 * Q_ERROR)
        for each in (row, with_power)
    ]
    assert six_digits(found) == [
        [5.76229e-05, 0.00012406, 4.85934e-05, 0.000254196, 6.34234e-05, 0.000420927],
        [5.76229e-05, 0.000126994, 4.98863e-05, 0.000253415, 7.32148e-05, 0.000468915],
    ]


def test_errors_of_a_feedforward_go_to_the_actuators_that_its_elements_drive():
    q = np.stack([Q, Q[::-1], 0.5 * Q], axis=1)
    z, h = 0.25 * q, np.array([[0.0, -0.125, -0.25, -0.1, 0.3, -0.75]]).T
    error = np.stack([1e-3 * Q_ERROR, 2e-3 * Q_ERROR, 4e-3 * Q_ERROR], axis=1)
    found = rounding._forward_errors(unlike_bank(), double_run.ForwardRun(q, h, z), error)
    assert six_digits(found) == [
        [0.00017709, 0.000678114],
        [0.000377928, 0.00134756],
        [0.000288491, 0.00133199],
        [0.000688472, 0.00266049],
        [0.000542263, 0.00263522],
        [0.00150541, 0.00394622],
    ]


def inverse_run():
    """Two actuators, one element, one lag, six samples."""
    target = np.stack([1e-4 * Q, -2e-4 * Q[::-1]], axis=1)
    rate = np.diff(target, axis=0, prepend=0.0) / PERIOD_S
    travel, h = 10.0 * target[:, :1], 0.1 * target[:, :1]
    return double_run.InverseRun(target, rate, travel, h, 5.0 * target[:, 1:], 100.0 * target)


def unlike_law():
    return replace(
        law((STEEP,), plays=((0.0, 900.0), (2e-5, -500.0), (1e-4, -200.0)), creep=((2e-6, 0.01),)),
        direct=np.array([300.0, -700.0]),
        play_actuator=np.array([1, 0, 1]),
        widening=np.array([[1e-3, 0.02], [2e-3, 0.05]]),
        lag_actuator=np.array([1]),
    )


def test_errors_of_an_inverse_belong_to_its_targets_rates_plays_and_lags():
    run, of = inverse_run(), unlike_law()
    error = np.stack([1e-9 * Q_ERROR, 3e-9 * Q_ERROR], axis=1)
    lag = 1e-3 * np.linspace(1.0, 2.0, 6)[:, None]
    target = rounding._target_errors(of, run, error, lag)
    controller = SimpleNamespace(inverse=of, actuators=2, period_s=PERIOD_S)
    rate = rounding._rate_errors(controller, run, target, np.zeros((6, 6)))
    added = np.zeros((6, 2))
    rounding._add_play_errors(of, run, target, rate, added)
    element = rounding._bouc_wen_errors(of.bouc_wen[0], run, 0, 1, target[:, 1], rate[:, 1])
    lags = rounding._lag_errors(of, run, 1e-3 * added + 1e-6)
    assert six_digits([target, rate, added, element, lags]) == [
        [
            [1.25e-10, 2.51806e-09],
            [2.5596e-10, 3.19769e-09],
            [8.03814e-11, 3.01134e-09],
            [5.11921e-10, 4.73576e-09],
            [5.50919e-11, 3.70567e-09],
            [8.21526e-10, 6.25e-09],
        ],
        [
            [6.25e-07, 1.40208e-05],
            [1.96441e-06, 3.04861e-05],
            [1.80092e-06, 3.17604e-05],
            [3.02112e-06, 3.88547e-05],
            [3.19269e-06, 4.24456e-05],
            [5.33676e-06, 4.98976e-05],
        ],
        [
            [3.80364e-07, 9.10774e-06],
            [1.13432e-06, 1.59694e-05],
            [1.14326e-06, 1.63882e-05],
            [1.80407e-06, 2.09497e-05],
            [1.81301e-06, 2.21264e-05],
            [3.2508e-06, 2.68555e-05],
        ],
        [5.59149e-05, 6.83177e-05, 8.7543e-05, 0.00011978, 0.000128002, 0.000343095],
        [[0.0], [2.11714e-08], [4.12662e-08], [6.07732e-08], [8.00834e-08], [9.88363e-08]],
    ]
    given = SimpleNamespace(inverse=replace(of, by_difference=False), actuators=2, period_s=PERIOD_S)
    outputs = np.arange(36.0).reshape(6, 6)
    assert rounding._rate_errors(given, run, target, outputs).tolist() == outputs[:, 4:6].tolist()


@pytest.mark.parametrize(
    ("resolution_v", "low_v", "high_v", "error_v", "found", "end_v"),
    [
        (0.0, -2.0, 3.0, [0.5, 7.0], [0.5, 5.0], 3.0),
        (0.0, -3.5, 3.0, [0.5], [0.5], 3.5),
        (0.25, -2.0, 3.0, [0.0, 0.3, 0.25], [0.25, 0.5, 0.5], 3.0),
        (0.25, -math.inf, math.inf, [1.1, math.inf], [1.25, 0.25 * (1e9 + 1.0)], 0.0),
        (0.1, -0.05, 0.02, [0.0], [0.07], 0.05),
    ],
)
def test_an_error_behind_a_converter_is_so_many_counts_within_the_limits(
    resolution_v, low_v, high_v, error_v, found, end_v
):
    of = SimpleNamespace(resolution_v=resolution_v, minimum_v=low_v, maximum_v=high_v)
    wanted = np.minimum(np.array(found) + 4.0 * rounding.UNIT * end_v, high_v - low_v)
    assert rounding.behind_converter(of, np.array(error_v)) == pytest.approx(wanted, rel=1e-12)


@pytest.mark.parametrize(
    ("changes", "numbers", "said"),
    [
        ({}, (0.5, 0.25, 1e-9, 77), "It stays within 0.5 V of double over these 77 samples; over the second half of"),
        (
            {"resolution_v": 0.125},
            (0.5, 0.0625, 1.5e-9, 77),
            "It stays within 0.5 V of double over these 77 samples (0.0625 V ahead of a converter of 0.125 V); over",
        ),
        ({}, (0.5, 5.0, 0.0, 9), "Over these 9 samples it is not bounded: errors may grow while commands are clipped."),
    ],
)
def test_a_bound_is_told_with_its_samples_converter_and_growth(changes, numbers, said):
    of = SimpleNamespace(**{"resolution_v": 0.0, "minimum_v": -2.0, "maximum_v": 3.0, "adaptation": None} | changes)
    found = rounding._words(of, *numbers)
    assert found.startswith(said)
    assert found.endswith((f"that grows by {numbers[2]:.2g} V a sample.", "clipped."))


def test_a_bound_grows_by_the_rise_of_its_second_half():
    assert rounding._growth(np.array([1.0, 3.0, 2.0, 2.0, 7.0])) == 2.0
    assert rounding._growth(np.array([1.0, 3.0, 2.0, 2.5])) == 0.0
    assert rounding._growth(np.array([1.0])) == rounding._growth(np.array([1.0, math.inf])) == 0.0


# ----------------------------------------------------------------------------------- hysteresis by hand, part by part
def test_a_feedforward_in_double_adds_a_spring_at_its_bias_and_operators_that_widen_and_bend():
    row = np.zeros(max(kernels.PER_SIZE, kernels.POWER, kernels.BIAS, kernels.RATE_LIMIT) + 1)
    numbers = {
        "D1": 2.5, "D2": 0.125, "EPSILON": -0.5, "DELTA": 0.25, "ALPHA": 0.75, "BETA": 0.25, "GAMMA": 0.125,
        "ETA": 0.0625, "RATE_LIMIT": 3.0, "BIAS": 1.5,
    }  # fmt: skip
    for name, number in numbers.items():
        row[getattr(kernels, name)] = number
    bank = SimpleNamespace(
        step_s=0.5, drives=np.array([[1.0, 2.0, -3.0], [0.5, 0.0, 4.0]]), bouc_wen=row[None],
        operator=np.array([[0.25, 1.0, 0.5, -0.75, 2.0, 4.0], [0.0, 9.0, 7.0, 7.0, 7.0, math.inf]]),
        play_threshold=np.array([0.0, 0.5, 0.25]), play_weight=np.array([1.25, -2.0, 3.0]),
        play_start=np.array([0, 2, 3]),
    )  # fmt: skip
    made, h, plays, before = double_run.Forward(bank, 4), 0.0, np.zeros(3), np.zeros(3)
    for q in np.array([[1.0, 2.0, -1.0], [4.0, 6.0, 0.5], [3.75, -5.0, 0.375], [3.0, -4.75, 2.0]]):
        travel = q - before
        rate = np.clip(travel[0] / 0.5, -3.0, 3.0)
        h = kernels.bouc_wen_step(h, travel[0], -0.5 * math.exp(0.25 * abs(rate)), 0.75, 0.25, 0.125, 0.0625)
        spring = 2.5 * math.exp(-0.125 * rate) * (q[0] + 1.5) - 2.5 * 1.5 + h
        half = np.array([0.0, 0.5 + 0.25 * min(abs(travel[1]) / 0.5, 1.0), 0.25])
        at = q[[1, 1, 2]]
        plays = np.maximum(at - half, np.minimum(at + half, plays))
        s = np.clip(q[1], -4.0, 4.0) / 4.0
        bent = 1.25 * plays[0] - 2.0 * plays[1] + 0.5 * s**2 - 0.75 * s * abs(s) + 2.0 * s**3
        z = np.array([spring, bent, 3.0 * plays[2]])
        np.testing.assert_allclose(made.step(q), bank.drives @ z, rtol=1e-12)
        np.testing.assert_allclose(made.record.z[made.k - 1], z, rtol=1e-12)
        before = q
    assert made.record.q[:, 1].tolist() == [2.0, 6.0, -5.0, -4.75] and made.record.h[-1, 0] == h


def test_an_inverse_in_double_has_targets_behind_creep_and_plays_that_widen_by_actuator():
    law = SimpleNamespace(
        by_difference=True, direct=np.array([2.0, 0.0]), bouc_wen=np.zeros((0, 12)), bouc_wen_actuator=np.zeros(0),
        play_threshold=np.array([0.0, 0.5, 0.25]), play_weight=np.array([1.5, -0.75, 2.5]),
        play_actuator=np.array([0, 0, 1]), widening=np.array([[0.125, 3.0], [0.0625, 100.0]]),
        lag_keep=np.array([0.75, 0.5, 0.25]), lag_weight=np.array([0.1, 0.2, 0.3]), lag_actuator=np.array([1, 0, 1]),
    )  # fmt: skip
    of = SimpleNamespace(inverse=law, period_s=0.5, actuators=2, adaptation=None)
    made = double_run.Inverse(of, 3)
    lag, play, before = np.zeros(3), np.zeros(3), np.zeros(2)
    for target in np.array([[1.0, -2.0], [3.0, 0.5], [2.5, 0.25]]):
        wanted = target - [0.2 * lag[1], 0.1 * lag[0] + 0.3 * lag[2]]
        rate = (wanted - before) / 0.5
        wide = np.array([0.125 * min(abs(rate[0]), 3.0), 0.0625 * min(abs(rate[1]), 100.0)])
        half = np.array([0.0, 0.5 + wide[0], 0.25 + wide[1]])
        at = wanted[[0, 0, 1]]
        play = np.maximum(at - half, np.minimum(at + half, play))
        added = np.array([2.0 * wanted[0] + 1.5 * play[0] - 0.75 * play[1], 2.5 * play[2]])
        np.testing.assert_allclose(made.step(np.array([9.0, 9.0, *target])), added, rtol=1e-12)
        np.testing.assert_allclose(made.record.rate[made.k - 1], rate, rtol=1e-12)
        np.testing.assert_allclose(made.record.lag[made.k - 1], lag, rtol=1e-12)
        lag = law.lag_keep * lag + (1.0 - law.lag_keep) * added[[1, 0, 1]]
        before = wanted
    law.by_difference = False
    other = double_run.Inverse(of, 1)
    other.step(np.array([9.0, 9.0, 1.0, 2.0, 0.5, -7.0]))
    assert other.record.rate.tolist() == [[0.5, -7.0]]


@pytest.mark.parametrize(
    ("rate", "wide"), [([8.0, -8.0], [0.375, 0.5]), ([-1.0, 0.0], [0.125, 0.0]), ([[2.0, 16.0]], [[0.25, 1.0]])]
)
def test_plays_widen_by_the_size_of_a_rate_up_to_its_limit(rate, wide):
    law = SimpleNamespace(widening=np.array([[0.125, 3.0], [0.0625, 100.0]]))
    assert double_run.widened(law, np.array(rate)).tolist() == wide


@pytest.mark.parametrize(
    ("resolution", "adaptation", "largest", "said"),
    [
        (0.0, None, 3.9, "It stays within 0.00123 V of double over these 70 samples; over the second half of "),
        (
            0.01,
            None,
            2.5e-4,
            "It stays within 0.00123 V of double over these 70 samples (0.00025 V ahead of a converter of 0.01 V); "
            "over the second half of ",
        ),
        (
            0.01,
            "learns",
            2.5e-4,
            "It stays within 0.00123 V of double over these 70 samples (0.00025 V ahead of a converter of 0.01 V), 6 "
            "times the rms of 64 runs with random roundings; over the second half of ",
        ),
        (0.01, "learns", 4.0, ""),
        (0.0, None, 5.0, ""),
    ],
)
def test_a_bound_is_told_with_its_converter_and_its_growth_or_as_none(resolution, adaptation, largest, said):
    of = SimpleNamespace(minimum_v=-1.5, maximum_v=2.5, resolution_v=resolution, adaptation=adaptation)
    none = "Over these 70 samples it is not bounded: errors may grow while commands are clipped."
    grows = "them that grows by 4.6e-08 V a sample."
    assert rounding._words(of, 1.2345e-3, largest, 4.56e-8, 70) == (said + grows if said else none)


def test_a_bound_is_the_largest_of_two_actuators_and_grows_by_the_worse_of_them(monkeypatch):
    """In counts of 0.01 V: 0.013 V ahead of the converter may be two of them behind it."""
    of = SimpleNamespace(resolution_v=0.01, minimum_v=-4.0, maximum_v=3.0)
    ahead = np.array([[0.003, 0.001], [0.002, 0.002], [0.0, 0.0], [0.004, 0.013], [0.005, 0.0], [0.0, 0.001]])
    asked = []
    monkeypatch.setattr(rounding, "errors_before_converter", lambda *given: asked.append(given) or ahead)
    monkeypatch.setattr(rounding, "_words", lambda *given: given)
    run = Vectors(np.zeros((6, 3)), np.zeros((6, 2)), 0, 0)
    found = rounding.rounding_bound(of, "form", run)
    assert asked == [(of, "form", run)]
    assert found.command_v == pytest.approx(0.02 + 4.0 * rounding.UNIT * 4.0)
    assert (found.samples, found.per_sample_v) == (6, pytest.approx(0.01 / 3.0))
    assert found.words == (of, found.command_v, 0.013, found.per_sample_v, 6)


class Learning:
    """A learner that turns target and error of its actuator into numbers of its own."""

    def __init__(self, law, phase, rounded):
        self.law, self.phase, self.rounded = law, phase, rounded

    def step(self, target, raw):
        return target - 10.0 * (self.phase + 1), raw * self.law + target


LEARNING = SimpleNamespace(
    by_difference=False, direct=np.array([5.0, 6.0, 7.0]), bouc_wen=np.zeros((0, 12)), bouc_wen_actuator=np.zeros(0),
    play_threshold=np.array([0.0, 0.5]), play_weight=np.ones(2), play_actuator=np.array([0, 1]),
    widening=np.zeros((3, 2)), lag_keep=np.array([0.75, 0.5]), lag_weight=np.array([0.125, 0.25]),
    lag_actuator=np.array([2, 0]),
)  # fmt: skip


@pytest.mark.parametrize("precision", ["double", "single"])
def test_each_of_three_actuators_learns_from_its_own_target_and_error_behind_its_own_creep(monkeypatch, precision):
    """Two samples of commands, targets, rates and errors, of three actuators each."""
    n, runs = 3, learning_rounding.RUNS
    gains = np.array([2.0, 3.0, 0.5])
    if precision == "double":
        monkeypatch.setattr(double_run, "laws", lambda of: of)
        monkeypatch.setattr(double_run, "Learner", Learning)
        of = SimpleNamespace(inverse=LEARNING, period_s=0.5, actuators=n, adaptation=gains.tolist())
        made = double_run.Inverse(of, 2)
        assert [(each.phase, each.rounded.unit, each.rounded.runs) for each in made.learners] == [
            (phase, 0.0, 1) for phase in range(n)
        ]
    else:
        made = object.__new__(learning_rounding._Single)
        made.of, made.n, made.rounded = SimpleNamespace(inverse=LEARNING), n, lambda x, operations=1: x
        made.learners = [Learning(gain, phase, None) for phase, gain in enumerate(gains)]
        made.lag_share, made.lag_weight = 1.0 - LEARNING.lag_keep[:, None], LEARNING.lag_weight[:, None]
        made.lag = np.zeros((2, runs))
    lag = np.zeros(2)
    for k, outputs in enumerate((np.arange(1.0, 13.0), np.array([4.0, 9, 1, 7, -2, 5, 8, 3, 6, -11, 12, 10]))):
        target = outputs[3:6] - [0.25 * lag[1], 0.0, 0.125 * lag[0]]
        added = outputs[9:] * gains + target
        if precision == "double":
            np.testing.assert_allclose(made.step(outputs), added, rtol=1e-12)
            np.testing.assert_allclose(made.record.target[k], target - [10.0, 20.0, 30.0], rtol=1e-12)
            assert made.record.rate[k].tolist() == outputs[6:9].tolist()
            np.testing.assert_allclose(made.record.lag[k], lag, rtol=1e-12)
        else:
            found = made._inverse(np.repeat(outputs[:, None], runs, axis=1))
            np.testing.assert_allclose(found, np.repeat(added[:, None], runs, axis=1), rtol=1e-12)
        lag = LEARNING.lag_keep * lag + (1.0 - LEARNING.lag_keep) * added[[2, 0]]


def test_what_adds_up_goes_on_from_what_it_may_be_at_most():
    """Errors of 8 that may be 2 at most leave half of 2 behind, not half of 8."""
    keep, added = np.array([0.5, 0.5, 0.5, 1.0]), np.array([1.0, 8.0, 0.0, 0.25])
    found = rounding._accumulated(keep, added, np.array([4.0, 2.0, 9.0, 9.0]))
    assert found.tolist() == [1.0, 2.0, 1.0, 1.25]
