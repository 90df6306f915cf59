"""The ensemble kernel against its twin, its random numbers against published ones, its row functions against libm."""

import os
import subprocess
import sys
from itertools import combinations, pairwise
from math import factorial, inf

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.linalg import block_diag
from scipy.stats import kstest

import oracle_pointing as pointing
from microrad.core import kernels
from microrad.core.kernels import random_numbers, side_by_side
from oracles import BoucWen, Operator, compose
from places import TESTS

LANES = kernels.LANES
STEP = 20e-6
PAPER = BoucWen(0.089, -2.96e-6, -0.048, 4.7e-4, 38.421, 34.635, 2500.0, 6.0)  # mrad and V
ADMISSIBLE = PAPER._replace(epsilon=-0.022, alpha=2.4, beta=0.6)
ASYMMETRIC = ADMISSIBLE._replace(gamma=0.5, eta=-0.7, d2=-1e-5)
POWERED = ASYMMETRIC._replace(exponent=2.0)
WIDENING = Operator((0.0, 0.2, 0.5), (0.03, 0.02, 0.04), widening=1e-4, rate_limit=1500.0)
RIGID = Operator((0.0, 0.1, 0.6), (0.05, -0.02, 0.03))
BENT = Operator((0.0, 0.3), (0.04, 0.02), polynomial=(0.02, -0.03, 0.04), reach=0.5)
rounding = 1e-12  # of the largest value: two routes through the same arithmetic
integrated = 1e-9  # another exponent than 1 is integrated with error control


def close(actual, expected, share=rounding):
    assert_allclose(actual, expected, rtol=0, atol=share * max(np.max(np.abs(expected), initial=0.0), 1e-300))


# ------------------------------------------------------------------------------------------------ random numbers

KNOWN_ANSWERS = [  # Random123, tests/kat_vectors, "philox4x32 10": counter, key, answer
    ("00000000 00000000 00000000 00000000", "00000000 00000000", "6627e8d5 e169c58d bc57ac4c 9b00dbd8"),
    ("ffffffff ffffffff ffffffff ffffffff", "ffffffff ffffffff", "408f276d 41c83b0e a20bc7c6 6d5451fd"),
    ("243f6a88 85a308d3 13198a2e 03707344", "a4093822 299f31d0", "d16cfe09 94fdcceb 5001e420 24126ea1"),
]
known_answers = pytest.mark.parametrize(
    ("counter", "key", "answer"), [[[int(w, 16) for w in text.split()] for text in case] for case in KNOWN_ANSWERS]
)


def gaussians(seed, first_run, purpose, first_block, blocks):
    """The kernel's numbers, (4 x blocks, LANES)."""
    numbers = np.full(4 * blocks * LANES, np.nan)
    words = np.array([seed & 0xFFFFFFFF, seed >> 32], dtype=np.uint64)
    first_block = (first_block + 2**63) % 2**64 - 2**63  # the kernel's places are signed
    kernels.gaussian_kernel(words, np.array([first_run], dtype=np.uint64), np.uint64(purpose), first_block, numbers)
    return numbers.reshape(-1, LANES)


@pytest.mark.promise("decisions-1")
@pytest.mark.promise("sampled-loop-16")
@pytest.mark.promise("pointing-10", "sampled-loop-16")
@known_answers
def test_philox_gives_the_known_answers(counter, key, answer):
    assert list(pointing.philox(counter, key)) == answer
    assert [int(w) for w in random_numbers.philox(*map(np.uint64, (*counter, *key)))] == answer


@known_answers
def test_gaussians_are_box_muller_of_the_known_answers(counter, key, answer):
    low, high, run, purpose = counter
    found = gaussians(key[0] | key[1] << 32, run, purpose, low | high << 32, 1)
    assert_allclose(found[:, 0], pointing.box_muller(answer), rtol=0, atol=1e-13)
    assert np.all(np.abs(found[:, 1:] - found[:, :1]) > 0)  # the other runs have other numbers


def test_gaussians_are_those_of_the_twin_for_every_run_block_and_word():
    seed, first_run, purpose, first_block = 0xFEDC_BA98_7654_3210, 2**32 - 5, 77, 2**32 - 2  # both counters carry
    found = gaussians(seed, first_run, purpose, first_block, 4)
    twin = [
        [pointing.gaussian(seed, first_run + lane, purpose, 4 * first_block + i) for lane in range(LANES)]
        for i in range(16)
    ]
    assert_allclose(found, twin, rtol=0, atol=1e-13)
    assert_array_equal(found[:, 5:], gaussians(seed, 0, purpose, first_block, 4)[:, :-5])  # run 2^32 is run 0
    assert_array_equal(found[8:], gaussians(seed, first_run, purpose, 2**32, 2))


def test_gaussians_are_normal_and_those_of_other_places_independent():
    """Moments, distribution and correlations within 5 standard deviations."""
    blocks = 1000
    found = gaussians(5, 0, 3, 0, blocks)
    n = found.size
    for order in range(1, 7):
        moment = 0.0 if order % 2 else factorial(order) / (2 ** (order // 2) * factorial(order // 2))
        variance = factorial(2 * order) / (2**order * factorial(order)) - moment**2
        assert abs(np.mean(found**order) - moment) < 5 * np.sqrt(variance / n)
    assert kstest(found.ravel(), "norm").pvalue > 1e-6
    words = found.reshape(blocks, 4, LANES)
    pairs = [(words[:, i], words[:, j]) for i, j in combinations(range(4), 2)]
    pairs += [(found[:-1], found[1:]), (found[:, :-1], found[:, 1:]), (words[:-1], words[1:])]
    pairs += [(found, other) for other in (gaussians(5, 0, 4, 0, blocks), gaussians(6, 0, 3, 0, blocks))]
    pairs += [(found, gaussians(5 + 2**32, 0, 3, 0, blocks)), (found, gaussians(5, LANES, 3, 0, blocks))]
    for one, other in pairs:
        for power in (1, 2):
            a, b = (x**power - (power == 2) for x in (one, other))
            assert abs(np.mean(a * b)) < 5 * 2 ** (power - 1) / np.sqrt(a.size)


def test_uniforms_lie_in_the_middle_of_their_cells_and_never_at_zero_or_one():
    for word in (0, 1, 2, 0x7FFFFFFF, 0x80000000, 0xFFFFFFFE, 0xFFFFFFFF):
        assert random_numbers.uniform(np.uint64(word)) == (word + 0.5) / 2**32
    assert 0 < random_numbers.uniform(np.uint64(0)) < random_numbers.uniform(np.uint64(0xFFFFFFFF)) < 1


# ------------------------------------------------------------------------------------------------ row functions


def over(function, x):
    return np.array([function(float(v)) for v in x])


def test_row_exponential_is_libms():
    x = np.concatenate([np.linspace(-700, 700, 4001), np.linspace(-1, 1, 4001), [0.0, -0.0, 1e-300, -1e-17]])
    error = np.max(np.abs(over(side_by_side.row_exp, x) / np.exp(x) - 1))
    print(f"exp within {error:.1e}")
    assert error < 2e-14
    assert side_by_side.row_exp(0.0) == 1.0


def test_row_exponential_is_held_outside_its_range():
    top, bottom = side_by_side.row_exp(700.0), side_by_side.row_exp(-700.0)
    assert [side_by_side.row_exp(x) for x in (700.1, 1e6, 1e300, inf)] == [top] * 4
    assert [side_by_side.row_exp(x) for x in (-700.1, -1e6, -1e300, -inf)] == [bottom] * 4
    assert side_by_side.row_exp(699.0) < top
    assert side_by_side.row_exp(-699.0) > bottom


def test_row_relaxation_is_libms():
    size = np.concatenate([np.geomspace(1e-18, 690, 4001), np.linspace(0.1, 2, 2001), [1e-300, 5e-324]])
    k = np.concatenate([size, -size])
    error = np.max(np.abs(over(side_by_side.row_relaxation, k) / (-np.expm1(-k) / k) - 1))
    print(f"(1 - exp(-k)) / k within {error:.1e}")
    assert error < 2e-14
    assert side_by_side.row_relaxation(0.0) == side_by_side.row_relaxation(-0.0) == 1.0


def test_near_row_functions_are_libms_up_to_where_they_are_good_for():
    x = np.concatenate([np.linspace(-1, 1, 4001), np.geomspace(1e-18, 1, 400), [0.0, -0.0]])
    error = np.max(np.abs(over(side_by_side.near_row_exp, side_by_side.NEAR_EXP * x) / np.exp(2 * x) - 1))
    k = side_by_side.NEAR_DECAY * x
    found = np.prod(over(side_by_side.near_row_relaxation, k), axis=1)
    expected = np.divide(-np.expm1(-k), k, out=np.ones_like(k), where=k != 0)
    away = np.max(np.abs(found / expected - 1))
    print(f"exp within {error:.1e}, (1 - exp(-k)) / k within {away:.1e}")
    assert error < 2e-15
    assert away < 2e-15
    assert (found[-2:] == 1.0).all()
    assert side_by_side.near_row_exp(0.0) == 1.0


def test_row_logarithm_is_libms():
    x = np.concatenate(
        [np.geomspace(2.3e-308, 1.7e308, 8001), np.linspace(0.5, 2, 4001), (np.arange(1, 2001) - 0.5) / 2**32]
    )
    expected = np.log(x)
    away = np.abs(expected) > 1e-3
    found = over(side_by_side.row_log, x)
    error = np.max(np.abs(found[away] / expected[away] - 1))
    print(f"ln within {error:.1e}, near 1 absolutely within {np.max(np.abs(found - expected)[~away]):.1e}")
    assert error < 1e-14
    assert_allclose(found[~away], expected[~away], rtol=0, atol=1e-16)
    assert side_by_side.row_log(1.0) == 0.0


def test_row_logarithm_keeps_its_digits_beside_one():
    """Box-Muller takes the logarithm of 1 - 2^-33: a radius there is as exact as any other."""
    near = np.concatenate([s * np.geomspace(2.0**-52, 0.1, 400) for s in (1, -1)])
    x = 1.0 + near
    assert_allclose(over(side_by_side.row_log, x), np.log1p(x - 1.0), rtol=1e-14)


def test_cosine_and_sine_of_a_turn_are_libms():
    turns = np.concatenate([np.linspace(0, 1, 8193), np.linspace(0, 1, 10_001), [2.0**-33, 1 - 2.0**-33]])
    found = np.array([random_numbers.cosine_sine(float(t)) for t in turns])
    expected = np.column_stack([np.cos(2 * np.pi * turns), np.sin(2 * np.pi * turns)])
    error = np.max(np.abs(found - expected))
    print(f"cos and sin within {error:.1e}")
    assert error < 2.5e-14
    assert_allclose(np.hypot(*found.T), 1.0, rtol=0, atol=2.5e-14)


# ------------------------------------------------------------------------------------------------ loops


def modes(rng, pairs, lags):
    """A matrix of damped modes of a few hundred hertz, and of lags."""
    blocks = []
    for _ in range(pairs):
        w, damping = 2 * np.pi * rng.uniform(400, 2500), rng.uniform(0.2, 0.6)
        root = np.sqrt(1 - damping**2)
        blocks.append(w * np.array([[-damping, root], [-root, -damping]]))
    return block_diag(*blocks, *([[-rng.uniform(40, 900)]] for _ in range(lags)))


def random_mirror(rng, actuators=1, outputs=1, bouc_wen=(), operators=(), **shape):
    """Modes and lags that elements and drives excite; ``fed_back`` lets them drive the elements, ``full`` fills A."""
    shape = {"pairs": 1, "lags": 0, "fed_back": False, "full": False} | shape
    A = modes(rng, shape["pairs"], shape["lags"])
    n, elements = len(A), len(bouc_wen) + len(operators)

    def any_of(*size):
        return rng.uniform(-1, 1, size)

    B, E = -0.05 * A @ any_of(n, actuators), -A @ any_of(n, elements)
    F, C = 2.0 * shape["fed_back"] * any_of(elements, n), 0.5 * any_of(outputs, n)
    if shape["full"]:
        T = np.eye(n) + 0.3 * any_of(n, n)
        A, B, E, F, C = T @ A @ np.linalg.inv(T), T @ B, T @ E, F @ np.linalg.inv(T), C @ np.linalg.inv(T)
    mirror = compose(
        states=n,
        actuators=actuators,
        outputs=outputs,
        bouc_wen=bouc_wen,
        operators=operators,
        A=A,
        B=B,
        E=E,
        F=F,
        G=np.resize(np.eye(actuators), (elements, actuators)) + 0.2 * any_of(elements, actuators),
        C=C,
        K=0.1 * any_of(outputs, elements),
    )
    wanted = 0.08 * (np.eye(outputs, actuators) + 0.2 * any_of(outputs, actuators))  # a gain that a controller can use
    return mirror._replace(D=wanted - straight_gain(mirror))


def straight_gain(mirror):
    """Output per drive at rest, each element at its straight slope."""
    slope = np.diag([*(row.d1 for row in mirror.bouc_wen), *(sum(o.weights) for o in mirror.operators)])
    E, K = mirror.E @ slope, mirror.K @ slope
    x = -np.linalg.solve(mirror.A + E @ mirror.F, mirror.B + E @ mirror.G)
    return mirror.C @ x + mirror.D + K @ (mirror.F @ x + mirror.G)


def shaking(rng, case, sources=2):
    """A loop with a disturbance on every axis: pairs of states and a single one, driven by that many sources."""
    turns = rng.uniform(0.05, 1.0, case.axes)
    blocks = [np.array([[np.cos(w), 1.3 * np.sin(w)], [-0.8 * np.sin(w), np.cos(w)]]) for w in turns]
    As = block_diag(*(0.93 * block for block in blocks), [[0.97]])
    Bs = 0.02 * rng.uniform(-1, 1, (len(As), sources))
    purpose = tuple(int(p) for p in rng.integers(0, kernels.SENSOR_PURPOSE, sources))
    return case._replace(As=As, Bs=Bs, Cs=rng.uniform(-1, 1, (case.axes, len(As))), purpose=purpose)


def random_loop(rng, mirror, axes=1, feedforward=False):
    """A PI controller with something of every input and two states more, half a sample of delay and an amplifier."""
    outputs, actuators = len(mirror.C), mirror.B.shape[1]
    optics = 2.0 * np.eye(axes, outputs) + 0.2 * rng.uniform(-1, 1, (axes, outputs))
    case = pointing.quiet_pointing(mirror, STEP, optics, actuators + 2, feedforward)
    gain = straight_gain(mirror)
    back, back_gauge = np.linalg.pinv(optics @ gain, rcond=0.2), np.linalg.pinv(gain, rcond=0.2)
    straight = np.hstack([0.15 * back, -0.05 * back_gauge, 0.7 * back])
    rows = [straight + 0.03 * np.abs(straight).max() * rng.uniform(-1, 1, straight.shape)]
    if feedforward:
        rows += [0.3 * rng.uniform(-1, 1, straight.shape), 400.0 * rng.uniform(-1, 1, straight.shape)]
    Cc = np.zeros((sum(map(len, rows)), actuators + 2))
    Cc[:actuators, :actuators] = np.eye(actuators)
    Cc[:, actuators:] = 0.1 * rng.uniform(-1, 1, (len(Cc), 2)) * np.abs(np.vstack(rows)).max(axis=1)[:, None]
    loop = case.loop._replace(
        steps_per_sample=2,
        delay_steps=1,
        Ac=block_diag(np.eye(actuators), [[0.6, 0.3], [-0.3, 0.6]]),
        Bc=np.vstack([0.05 * straight, rng.uniform(-1, 1, (2, straight.shape[1]))]),
        Cc=Cc,
        Dc=np.vstack(rows),
        L=0.5 * np.eye(actuators + 2, actuators) + 0.1 * rng.uniform(-1, 1, (actuators + 2, actuators)),
        amplifier_factor=rng.uniform(0.3, 0.6, actuators),
    )
    return shaking(rng, case._replace(loop=loop, seed=int(rng.integers(2**63))))


def with_loop(case, **fields):
    """The loop with other numbers in its controller, converters, amplifier or inverse; by actuator if they are so."""
    one_each = ("command_min", "command_max", "drive_resolution", "amplifier_factor", "slew_step", "inverse_direct")
    each = {k: np.full(case.actuators, v) if k in one_each else v for k, v in fields.items()}
    return case._replace(loop=case.loop._replace(**each))


def make_reference(case, samples):
    """Sines of 0.3 mrad with a jump, (samples + 1, axes)."""
    t = STEP * case.loop.steps_per_sample * np.arange(samples + 1)
    columns = [0.3 * np.sin(2 * np.pi * f * t + f) for f in (430, 610)[: case.axes]]
    reference = np.column_stack(columns)
    reference[samples // 2 :] += 0.15
    return reference


def make_start(case):
    """Where the disturbances begin, (states, LANES)."""
    return 0.03 * np.random.default_rng(len(case.As)).standard_normal((len(case.As), LANES))


def kernel(case, samples=40, first_run=100):
    return pointing.run_kernel(case, first_run, make_start(case), make_reference(case, samples))


def twins(case, lanes, samples=40, first_run=100):
    start, reference = make_start(case), make_reference(case, samples)
    return [pointing.run_twin(case, first_run + i, start[:, i], reference) for i in lanes]


def assert_same(ensemble, found, lanes, share=rounding):
    """Residual, trace, statistics, counts and memory of those runs of a batch are those of their twins."""
    lanes = list(lanes)
    state, axes = ensemble.state, ensemble.residual.shape[1]

    def same(ours, twin):
        size = max(np.max(np.abs(twin), initial=0.0), 1e-3)  # bias and reference are larger, and cancel
        assert_allclose(ours, twin, rtol=0, atol=share * size)

    same(ensemble.residual[:, :, lanes].transpose(2, 0, 1), [[e for e, _ in t.samples] for t in found])
    traces = np.array([[row for _, row in t.samples] for t in found])
    for channel in range(traces.shape[2]):
        same(ensemble.trace[:, channel, lanes].T, traces[:, :, channel])
    errors = np.array([t.errors[1:] for t in found])  # at the end of each plant step
    every = errors.shape[1] // len(found[0].samples)
    same(ensemble.lines("sum")[:axes, lanes].T, errors[:, every - 1 :: every].sum(axis=1))  # of each control sample
    same(ensemble.lines("sum_square")[:axes, lanes].T, np.sum(errors**2, axis=1))
    same(ensemble.lines("largest")[0, lanes], np.max(np.sum(errors**2, axis=2), axis=1))
    assert_array_equal(ensemble.lines("counts")[:, lanes].T, [t.counts() for t in found])
    assert_array_equal(state.place, [len(traces[0]), errors.shape[1], 1])
    memory = {
        "x": [t.mirror.x_less_its_end() for t in found],
        "xc": [t.xc for t in found],
        "shaping": [t.s for t in found],
        "error": [t.errors[-1] for t in found],
        "play": [[p for operator in t.mirror.p for p in operator] for t in found],
        "inverse": [t.inverse.h for t in found],
        "inverse_play": [t.inverse.p for t in found],
        "inverse_lag": [t.inverse.lag for t in found],
        "forward_play": [[p for operator in t.forward.p for p in operator] for t in found],
    }
    for name, twin in memory.items():
        same(ensemble.lines(name)[: len(twin[0]), lanes].T, twin)
    elements = found[0].mirror.q.size
    bank = ensemble.lines("bank")[: elements * kernels.BANK_FIELDS].reshape(elements, kernels.BANK_FIELDS, LANES)
    same(ensemble.lines("q")[:elements, lanes].T, [t.mirror.q for t in found])
    same(ensemble.lines("z")[:elements, lanes].T, [t.mirror.z for t in found])
    h = [t.mirror.h for t in found]
    same(bank[: len(h[0]), kernels.BANK_H, lanes].T, h)


def share_of(case):
    """To what share of the largest value a loop agrees with its twin."""
    elements = (*case.mirror.bouc_wen, *case.loop.inverse_bouc_wen, *case.forward.bouc_wen)
    return integrated if any(row.exponent != 1.0 for row in elements) else rounding


def assert_is_its_twin(case, lanes=(37,), samples=40, first_run=100):
    ensemble = kernel(case, samples, first_run)
    assert np.max(np.abs(ensemble.residual)) < 3.0  # it does not run away, which would make everything else look small
    found = twins(case, lanes, samples, first_run)
    assert_same(ensemble, found, lanes, share_of(case))
    assert np.ptp(ensemble.residual, axis=2).min() > 0  # no run is another one
    return ensemble, found


# ------------------------------------------------------------------------------------------------ mirrors

ONE_AXIS = {
    "no hysteresis": {"pairs": 2},
    "no hysteresis, a state alone and creep": {"pairs": 1, "lags": 2},
    "no hysteresis, states of a full matrix": {"pairs": 2, "lags": 1, "full": True},
    "Bouc-Wen of the paper": {"bouc_wen": (PAPER,)},
    "Bouc-Wen beside creep": {"bouc_wen": (ADMISSIBLE,), "lags": 3},
    "asymmetric Bouc-Wen": {"bouc_wen": (ASYMMETRIC, ASYMMETRIC._replace(gamma=-1.5, eta=0.4, epsilon=0.02))},
    "Bouc-Wen with a drive term that depends on the rate": {"bouc_wen": (ADMISSIBLE._replace(d2=-1.6e-4),)},
    "Bouc-Wen that runs away from zero": {"bouc_wen": (PAPER._replace(alpha=3.0, beta=-9.0),)},
    "Bouc-Wen without decay": {"bouc_wen": (PAPER._replace(alpha=0.0, beta=0.0),)},
    "Bouc-Wen without forcing": {"bouc_wen": (PAPER._replace(epsilon=0.0),)},
    "Bouc-Wen, exponent 2": {"bouc_wen": (POWERED,)},
    "Bouc-Wen, exponents 1.4, 1 and 3": {
        "bouc_wen": (ADMISSIBLE._replace(exponent=1.4), PAPER, ASYMMETRIC._replace(exponent=3.0))
    },
    "plays": {"operators": (RIGID,)},
    "plays that widen": {"operators": (WIDENING,)},
    "two operators": {"operators": (WIDENING, RIGID)},
    "Bouc-Wen and plays": {"bouc_wen": (PAPER, ADMISSIBLE), "operators": (RIGID, WIDENING)},
    "Bouc-Wen fed back": {"bouc_wen": (PAPER, ASYMMETRIC), "fed_back": True},
    "plays fed back": {"operators": (WIDENING, RIGID), "fed_back": True, "lags": 1},
    "Bouc-Wen and plays fed back, full matrix": {
        "bouc_wen": (ADMISSIBLE, PAPER),
        "operators": (WIDENING,),
        "fed_back": True,
        "full": True,
        "pairs": 2,
    },
}


@pytest.mark.promise("decisions-1")
@pytest.mark.promise("sampled-loop-3")
@pytest.mark.promise("pointing-9", "sampled-loop-3")
@pytest.mark.parametrize("shape", ONE_AXIS.values(), ids=ONE_AXIS.keys())
def test_a_loop_around_any_mirror_is_its_twin(shape):
    rng = np.random.default_rng(3)
    case = random_loop(rng, random_mirror(rng, **shape))
    _, found = assert_is_its_twin(case)
    for row, clamped in zip((*case.mirror.bouc_wen, *case.mirror.operators), found[0].mirror.clamped, strict=True):
        assert clamped < 80
        assert (clamped > 0) == (row.rate_limit < inf)
    if PAPER in case.mirror.bouc_wen:
        assert all(twin.crossings > 0 for twin in found)


@pytest.mark.parametrize("outputs", [1, 2, 3])
@pytest.mark.parametrize("actuators", [1, 2, 3])
@pytest.mark.parametrize("axes", [1, 2])
def test_axes_actuators_and_outputs_of_any_number(axes, actuators, outputs):
    rng = np.random.default_rng(100 * axes + 10 * actuators + outputs)
    bank = {"bouc_wen": (ADMISSIBLE, PAPER)[: axes + 1], "operators": (WIDENING,)}
    case = random_loop(rng, random_mirror(rng, actuators, outputs, pairs=2, **bank), axes)
    ensemble, _ = assert_is_its_twin(case._replace(gauge_noise=0.01, optical_noise=(0.02, 0.01)[:axes]))
    assert ensemble.residual.shape == (40, axes, LANES)


@pytest.mark.promise("readme-19")
def test_all_runs_of_a_batch_are_their_twins():
    rng = np.random.default_rng(8)
    mirror = random_mirror(rng, 2, 2, bouc_wen=(PAPER, ASYMMETRIC), operators=(WIDENING, BENT))
    assert_is_its_twin(random_loop(rng, mirror, 2), range(LANES), samples=15)


def test_run_numbers_beyond_32_bits_begin_again():
    rng = np.random.default_rng(9)
    case = random_loop(rng, random_mirror(rng, bouc_wen=(PAPER,)))
    assert_is_its_twin(case, (2, 3, 63), first_run=2**32 - 3)


# ------------------------------------------------------------------------------------------------ one feature at a time


def plain():
    """One axis with a Bouc-Wen element and a play."""
    rng = np.random.default_rng(17)
    return random_loop(rng, random_mirror(rng, bouc_wen=(ADMISSIBLE,), operators=(RIGID,)))


def plain_inverse(actuators=1):
    """A loop whose inverse hands its target on."""
    rng = np.random.default_rng(18)
    mirror = random_mirror(rng, actuators, actuators, bouc_wen=(ADMISSIBLE,), operators=(RIGID,))
    return with_loop(random_loop(rng, mirror, min(actuators, 2), feedforward=True), inverse_direct=2.0)


def with_forward(case, *elements, seed=31):
    """The loop with hysteresis that its controller runs on what it reads."""
    rng = np.random.default_rng(seed)
    bouc_wen = tuple(each for each in elements if isinstance(each, BoucWen))
    operators = tuple(each for each in elements if isinstance(each, Operator))
    n, m, s = len(elements), case.actuators, case.loop
    drives = 3.0 * rng.uniform(-1, 1, (m, n))
    forward = compose(actuators=n, outputs=m, bouc_wen=bouc_wen, operators=operators, G=np.eye(n), K=drives)
    Cc = np.vstack([s.Cc, 0.1 * rng.uniform(-1, 1, (n, s.Cc.shape[1]))])
    Dc = np.vstack([s.Dc, rng.uniform(-1, 1, (n, s.Dc.shape[1]))])
    return with_loop(case, Cc=Cc, Dc=Dc)._replace(forward=forward)


INVERSE_ROW = ADMISSIBLE._replace(rate_limit=600.0, d2=-1e-5)


def features():
    """Pairs of loops: with a feature, and without it."""
    one, inverse, three = plain(), plain_inverse(), plain_inverse(3)
    noisy = one._replace(optical_noise=(0.03,), gauge_noise=0.02)
    straight = with_loop(one, delay_steps=0, amplifier_factor=1.0)
    plays = {
        "inverse_play_threshold": (0.02, 0.05),
        "inverse_play_weight": (2.0, -1.0),
        "inverse_play_actuator": (0, 0),
    }
    bouc_wen = {"inverse_bouc_wen": (INVERSE_ROW,), "inverse_bouc_wen_actuator": (0,)}
    creep = {"inverse_creep": ((0.03, 1e-3, 0), (-0.02, 3e-3, 0), (0.04, 0.5, 0))}
    several = {
        "inverse_bouc_wen": (INVERSE_ROW, PAPER, ASYMMETRIC),
        "inverse_bouc_wen_actuator": (2, 0, 2),
        "inverse_play_threshold": (0.02, 0.01, 0.05, 0.0),
        "inverse_play_weight": (2.0, -1.0, 0.5, 1.0),
        "inverse_play_actuator": (1, 2, 1, 0),
        "inverse_widening": ((0.0, inf), (2e-4, 120.0), (1e-4, 90.0)),
        "inverse_creep": ((0.02, 1e-3, 2), (-0.02, 3e-3, 0), (0.03, 0.5, 1)),
    }
    return {
        "disturbance without noise": (shaking(np.random.default_rng(1), one, 0), one._replace(Cs=0 * one.Cs)),
        "disturbance of one source": (shaking(np.random.default_rng(1), one, 1), one._replace(Bs=0 * one.Bs)),
        "disturbance of seven sources": (shaking(np.random.default_rng(2), one, 7), one._replace(Bs=0 * one.Bs)),
        "another seed": (one._replace(seed=one.seed ^ 1), one),
        "another upper half of the seed": (one._replace(seed=one.seed ^ 1 << 40), one),
        "optical noise": (one._replace(optical_noise=(0.03,)), one),
        "gauge noise": (one._replace(gauge_noise=0.05), one),
        "optical sensor of every third sample": (one._replace(sensor_every=3), one),
        "noisy optical sensor of every third sample": (noisy._replace(sensor_every=3), noisy),
        "optical sensor late by one step": (one._replace(sensor_delay_steps=1), one),
        "optical sensor late by seven steps": (one._replace(sensor_delay_steps=7), one),
        "late optical sensor of every third sample": (
            noisy._replace(sensor_every=3, sensor_delay_steps=5),
            noisy._replace(sensor_every=3),
        ),
        "optical resolution": (one._replace(optical_resolution=0.02), one),
        "optical resolution and noise": (noisy._replace(optical_resolution=0.02), noisy),
        "gauge resolution": (one._replace(gauge_resolution=0.05), one),
        "field of view": (one._replace(field_of_view=0.15), one),
        "field of view of a late sensor of every third sample": (
            noisy._replace(field_of_view=0.15, sensor_every=3, sensor_delay_steps=5),
            noisy._replace(sensor_every=3, sensor_delay_steps=5),
        ),
        "command's resolution": (with_loop(one, drive_resolution=0.1), one),
        "saturation": (with_loop(one, command_min=-0.9, command_max=1.1), one),
        "saturation without anti-windup": (
            with_loop(one, command_min=-0.9, command_max=1.1, L=0 * one.loop.L),
            with_loop(one, command_min=-0.9, command_max=1.1),
        ),
        "saturation and the command's resolution": (
            with_loop(one, command_min=-0.93, command_max=1.13, drive_resolution=0.1),
            with_loop(one, command_min=-0.93, command_max=1.13),
        ),
        "slew limit": (with_loop(one, slew_step=0.08), one),
        "ideal amplifier": (straight, with_loop(straight, amplifier_factor=0.9)),
        "slew limit of an ideal amplifier": (with_loop(straight, slew_step=0.1), straight),
        "one step a sample": (with_loop(one, steps_per_sample=1), one),
        "five steps a sample": (with_loop(one, steps_per_sample=5), one),
        **{
            f"delay of {delay} steps at {steps} a sample": (
                with_loop(one, steps_per_sample=steps, delay_steps=delay),
                with_loop(one, steps_per_sample=steps, delay_steps=delay + 1),
            )
            for steps, delay in ((1, 0), (1, 1), (1, 4), (3, 0), (3, 2), (3, 3), (3, 4), (3, 11), (4, 8))
        },
        "inverse gain": (inverse, with_loop(inverse, inverse_direct=0.0)),
        "inverse of a Bouc-Wen element": (with_loop(inverse, **bouc_wen), inverse),
        "inverse of an asymmetric element": (
            with_loop(inverse, **bouc_wen | {"inverse_bouc_wen": (ASYMMETRIC,)}),
            with_loop(inverse, **bouc_wen),
        ),
        "inverse of an element of exponent 2": (
            with_loop(inverse, **bouc_wen | {"inverse_bouc_wen": (POWERED,)}),
            with_loop(inverse, **bouc_wen | {"inverse_bouc_wen": (ASYMMETRIC,)}),
        ),
        "inverse of plays": (with_loop(inverse, **plays), inverse),
        "inverse of plays that widen": (
            with_loop(inverse, **plays, inverse_widening=((1e-3, 15.0),)),
            with_loop(inverse, **plays),
        ),
        "inverse of creep": (with_loop(inverse, **creep), inverse),
        "inverse of creep and hysteresis": (with_loop(inverse, **creep, **bouc_wen), with_loop(inverse, **bouc_wen)),
        "inverse of three actuators": (with_loop(three, **several), three),
        "inverse ahead of the saturation": (
            with_loop(inverse, **bouc_wen, command_min=-0.8, command_max=0.9),
            with_loop(inverse, **bouc_wen),
        ),
        "feedforward of a Bouc-Wen element": (with_forward(one, ADMISSIBLE), one),
        "feedforward of an element of exponent 2": (with_forward(one, POWERED), with_forward(one, ASYMMETRIC)),
        "feedforward of plays": (with_forward(one, RIGID), one),
        "feedforward of plays that widen": (with_forward(one, WIDENING), one),
        "feedforward of a polynomial": (with_forward(one, BENT), with_forward(one, BENT._replace(reach=inf))),
        "feedforward of five elements on three actuators": (
            with_forward(three, PAPER, BENT, ADMISSIBLE, RIGID, BENT),
            three,
        ),
        "feedforward ahead of the saturation": (
            with_loop(with_forward(one, RIGID), command_min=-0.8, command_max=0.9),
            with_forward(one, RIGID),
        ),
    }


FEATURES = features()
COUNTED = {  # what a feature makes the kernel count
    "field of view": ("lost",),
    "field of view of a late sensor of every third sample": ("lost",),
    "saturation": ("saturated",),
    "saturation without anti-windup": ("saturated",),
    "saturation and the command's resolution": ("saturated",),
    "slew limit": ("slew",),
    "slew limit of an ideal amplifier": ("slew",),
    "inverse of a Bouc-Wen element": ("inverse_clamped",),
    "inverse of plays that widen": ("inverse_clamped",),
    "inverse of creep and hysteresis": ("inverse_clamped",),
    "inverse of three actuators": ("inverse_clamped",),
    "inverse ahead of the saturation": ("saturated",),
    "feedforward of plays that widen": ("inverse_clamped",),
    "feedforward of five elements on three actuators": ("inverse_clamped",),
    "feedforward ahead of the saturation": ("saturated",),
}


@pytest.mark.promise("pointing-9", "sampled-loop-15")
@pytest.mark.parametrize("name", FEATURES)
def test_a_loop_with_one_feature_is_its_twin_and_not_the_loop_without_it(name):
    case, without = FEATURES[name]
    ensemble, found = assert_is_its_twin(case, (60,))
    if case.loop.steps_per_sample == without.loop.steps_per_sample:
        difference = np.max(np.abs(kernel(without).residual - ensemble.residual), axis=(0, 1))
        assert np.mean(difference > 1e-4 * np.max(np.abs(ensemble.residual))) > 0.9
    counts = {counter: [getattr(twin.counts(), counter) for twin in found] for counter in found[0].counts()._fields}
    for counter in ("saturated", "slew", "inverse_clamped", "lost"):
        assert (min(counts[counter]) > 0) == (max(counts[counter]) > 0) == (counter in COUNTED.get(name, ()))


def test_a_lost_spot_is_found_again():
    """The reading is held through the whole time beyond the field of view, and follows the error behind it."""
    case = FEATURES["field of view"][0]
    ensemble = kernel(case)
    error, reading = ensemble.residual[:, 0], ensemble.trace[:, 4]
    beyond = np.abs(error) > case.field_of_view
    assert_array_equal(reading[~beyond], error[~beyond])
    assert_array_equal(reading[1:][beyond[1:]], reading[:-1][beyond[1:]])
    assert_array_equal(np.sum(beyond, axis=0), ensemble.lines("counts")[kernels.COUNT_LOST])
    changes = np.sum(np.diff(beyond.astype(int), axis=0) == -1, axis=0)
    assert np.mean(changes) > 0.5


def test_the_field_of_view_is_a_circle():
    rng = np.random.default_rng(21)
    case = random_loop(rng, random_mirror(rng, 2, 2, bouc_wen=(PAPER,)), 2)._replace(field_of_view=0.3)
    ensemble, _ = assert_is_its_twin(case)
    one_axis = np.any(np.abs(ensemble.residual) > 0.3, axis=1).sum(axis=0)
    assert np.sum(ensemble.lines("counts")[kernels.COUNT_LOST]) > 1.2 * np.sum(one_axis) > 0


def test_an_error_on_the_edge_of_the_field_of_view_is_still_seen_and_the_first_reading_is_zero():
    for limit, seen in ((0.5, True), (np.nextafter(0.5, 0.0), False)):
        case = pointing.quiet_pointing(compose(D=1.0), STEP, [[1.0]])._replace(field_of_view=limit)
        ensemble = pointing.run_kernel(case, 0, np.zeros((0, LANES)), np.full((4, 1), 0.5))
        assert_array_equal(ensemble.trace[:, 4], 0.5 if seen else 0.0)
        assert_array_equal(ensemble.lines("counts")[kernels.COUNT_LOST], 0 if seen else 3)


@pytest.mark.promise("decisions-1")
@pytest.mark.promise("sampled-loop-16")
@pytest.mark.promise("pointing-10", "sampled-loop-16")
def test_no_stream_has_two_uses():
    """The purposes of the sources, then those of the sensors' words, then what starts each source: one word in all."""
    assert 0 < kernels.SENSOR_PURPOSE < kernels.START_PURPOSE - 1000
    assert kernels.START_PURPOSE + kernels.SENSOR_PURPOSE <= 2**32


def test_drives_outside_their_range_are_counted_by_plant_step_and_actuator():
    rng = np.random.default_rng(22)
    case = random_loop(rng, random_mirror(rng, 2, 2, bouc_wen=(ADMISSIBLE,)), 2)
    wide, _ = assert_is_its_twin(case)
    assert not wide.lines("counts")[kernels.COUNT_OUTSIDE].any()
    for low, high in ((-1.0, inf), (-inf, 0.8), (-0.7, 0.9)):
        narrow = case._replace(drive_low=np.array([low, -inf]), drive_high=np.array([inf, high]))
        ensemble, found = assert_is_its_twin(narrow)
        assert np.all(ensemble.lines("counts")[kernels.COUNT_OUTSIDE] > 0)
        assert found[0].outside < 160  # steps and actuators
        assert_array_equal(ensemble.residual, wide.residual)  # it is a count, not a limit


# ------------------------------------------------------------------------------------------------ everything at once


def random_pointing(seed):
    """A loop with a random choice of everything."""
    rng = np.random.default_rng([2, seed])
    axes, actuators, outputs = (int(n) for n in (rng.integers(1, 3), rng.integers(1, 4), rng.integers(1, 4)))
    rows = [PAPER, ADMISSIBLE, ASYMMETRIC, PAPER._replace(gamma=-3.0, eta=2.0, epsilon=0.03, bias=0.0)]
    bouc_wen = tuple(rows[i] for i in rng.choice(4, rng.integers(0, 4)))
    operators = tuple((RIGID, WIDENING, BENT)[i] for i in rng.choice(3, rng.integers(0, 3)))
    shape = {"pairs": int(rng.integers(1, 4)), "lags": int(rng.integers(0, 3))}
    shape |= {"fed_back": bool(rng.integers(2)), "full": bool(rng.integers(2))}
    mirror = random_mirror(rng, actuators, outputs, bouc_wen, operators, **shape)
    case = shaking(rng, random_loop(rng, mirror, axes, feedforward=bool(rng.integers(2))), int(rng.integers(1, 10)))

    def perhaps(value, otherwise):
        return value if rng.integers(2) else otherwise

    def owners(count):
        return tuple(int(a) for a in rng.integers(0, actuators, count))

    elements, plays, lags = (int(n) for n in rng.integers(0, 4, 3))
    case = with_loop(
        case,
        steps_per_sample=int(rng.integers(1, 5)),
        delay_steps=int(rng.integers(0, 9)),
        command_min=perhaps(rng.uniform(-2, -1, actuators), -5.0),
        command_max=perhaps(rng.uniform(1, 2, actuators), 5.0),
        drive_resolution=perhaps(rng.uniform(1e-3, 0.1, actuators), 0.0),
        slew_step=perhaps(rng.uniform(0.1, 0.5, actuators), inf),
        inverse_direct=rng.uniform(-2, 2, actuators),
        inverse_bouc_wen=tuple(rows[i]._replace(rate_limit=600.0) for i in rng.choice(4, elements)),
        inverse_bouc_wen_actuator=owners(elements),
        inverse_play_threshold=tuple(rng.uniform(0, 0.1, plays) * rng.integers(0, 2, plays)),
        inverse_play_weight=tuple(rng.uniform(-2, 2, plays)),
        inverse_play_actuator=owners(plays),
        inverse_widening=tuple(zip(rng.uniform(0, 3e-4, actuators), rng.uniform(20, 300, actuators), strict=True)),
        inverse_creep=tuple(
            zip(rng.uniform(-0.03, 0.03, lags), rng.uniform(5e-4, 5e-3, lags), owners(lags), strict=True)
        ),
    )
    return case._replace(
        sensor_delay_steps=int(rng.integers(0, 9)),
        sensor_every=int(rng.integers(1, 4)),
        optical_noise=tuple(rng.uniform(0, 0.05, axes)),
        optical_resolution=perhaps(0.01, 0.0),
        field_of_view=perhaps(0.4, inf),
        gauge_noise=perhaps(0.02, 0.0),
        gauge_resolution=perhaps(0.01, 0.0),
        drive_low=rng.uniform(-2, 0, actuators),
        drive_high=rng.uniform(0, 2, actuators),
    )


@pytest.mark.promise("sampled-loop-3")
@pytest.mark.parametrize("seed", range(40))
def test_a_loop_with_a_random_choice_of_everything_is_its_twin(seed):
    assert_is_its_twin(random_pointing(seed), (seed, 63 - seed), samples=30, first_run=1000 * seed)


def with_zeros(seed):
    """A random loop with zeros, whole rows of them among others, in all its matrices."""
    case, rng = random_pointing(seed), np.random.default_rng([3, seed])

    def thinned(matrix):
        kept = rng.random(matrix.shape) < 0.6
        return matrix * kept * (rng.random((len(matrix), 1)) < 0.7)

    mirror = case.mirror._replace(**{name: thinned(getattr(case.mirror, name)) for name in "BEFGCDK"})
    loop = case.loop._replace(**{name: thinned(getattr(case.loop, name)) for name in ("Ac", "Bc", "Cc", "Dc", "L")})
    thin = {name: thinned(getattr(case, name)) for name in ("optics", "Bs", "Cs")}
    return case._replace(mirror=mirror, loop=loop, **thin)


@pytest.mark.parametrize("seed", range(40, 60))
def test_a_loop_with_zeros_anywhere_is_its_twin(seed):
    case, lanes = with_zeros(seed), (seed, 63 - seed)
    assert_same(kernel(case, 20), twins(case, lanes, 20), lanes)


def test_the_random_choices_count_everything():
    ensembles = [kernel(random_pointing(seed), 30, 1000 * seed) for seed in range(40)]
    sometimes = np.array([np.any(e.lines("counts") > 0, axis=1) for e in ensembles]).sum(axis=0)
    assert np.all(np.delete(sometimes, kernels.COUNT_FALLBACK) > 5)


# ------------------------------------------------------------------------------------------------ statistics

STATISTICS = ("sum", "sum_square", "largest", "histogram")


def statistics_case():
    """Two axes with some of everything that counts."""
    rng = np.random.default_rng(31)
    mirror = random_mirror(rng, 2, 2, bouc_wen=(PAPER, ADMISSIBLE), operators=(WIDENING, BENT), fed_back=True)
    case = random_loop(rng, mirror, 2, feedforward=True)
    case = with_loop(
        case,
        delay_steps=5,
        command_min=-1.5,
        command_max=1.5,
        slew_step=0.3,
        inverse_direct=0.5,
        inverse_bouc_wen=(INVERSE_ROW,),
        inverse_bouc_wen_actuator=(1,),
        inverse_play_threshold=(0.02,),
        inverse_play_weight=(0.5,),
        inverse_play_actuator=(0,),
        inverse_creep=((0.03, 1e-3, 1),),
    )
    case = case._replace(field_of_view=0.6, sensor_every=3, sensor_delay_steps=3, optical_noise=(0.02, 0.03))
    return case._replace(gauge_noise=0.01, drive_low=np.full(2, -1.0), drive_high=np.full(2, 1.0))


@pytest.mark.promise("sampled-loop-15")
def test_every_counter_is_its_twins():
    ensemble, _ = assert_is_its_twin(statistics_case(), range(0, LANES, 8))
    counted = np.any(ensemble.lines("counts") > 0, axis=1)
    assert np.all(np.delete(counted, kernels.COUNT_FALLBACK))  # an adaptive inverse's: tests/core/test_adaptive_kernel
    assert len(ensemble.lines("counts")) == kernels.COUNT_FIELDS == len(pointing.Counts._fields)


@pytest.mark.promise("pointing-98")
def test_the_histogram_counts_the_radial_error_at_the_end_of_each_control_sample():
    from microrad.loop.pointing_loop.ensemble import bin_edges_rad  # the rest of this file needs the kernel alone

    edges = bin_edges_rad()
    assert edges.size == kernels.BINS + 1
    assert edges[-1] == 1.0
    ensemble = kernel(statistics_case(), 200)
    at_ends = np.concatenate([ensemble.residual[1:], ensemble.lines("error")[None, :2]])
    radial = np.hypot(at_ends[:, 0], at_ends[:, 1])
    assert np.max(radial) < 1.0
    for lane in range(LANES):
        assert_array_equal(ensemble.state.histogram[lane], np.histogram(radial[:, lane], edges)[0])
    assert np.count_nonzero(ensemble.state.histogram[0]) > 30


@pytest.mark.parametrize(("error", "at"), [(0.0, 0), (1e-30, 0), (1.1e-10, 0), (1.0, -1), (7.0, -1), (1e9, -1)])
def test_errors_beyond_the_histogram_are_in_its_outer_bins(error, at):
    case = pointing.quiet_pointing(compose(D=1.0), STEP, [[1.0]])
    ensemble = pointing.run_kernel(case, 0, np.zeros((0, LANES)), np.full((4, 1), error))
    assert_array_equal(ensemble.residual, error)
    histogram = ensemble.state.histogram
    assert_array_equal(histogram[:, at], 3)
    assert np.sum(histogram) == 3 * LANES


@pytest.mark.parametrize("error", [2.0**-20, 2.0**-8, 0.25, 0.5])
def test_a_bin_begins_at_its_lower_edge(error):
    case = pointing.quiet_pointing(compose(D=1.0), STEP, [[1.0]])
    bins = []
    for value in (error, np.nextafter(error, 0.0)):
        ensemble = pointing.run_kernel(case, 0, np.zeros((0, LANES)), np.full((2, 1), value))
        bins.append(int(np.argmax(ensemble.state.histogram[0])))
    assert bins[0] == bins[1] + 1
    octave, part = divmod(bins[0], 1 << kernels.BINS_OCTAVE_BITS)
    assert (2.0 ** (octave + kernels.BINS_LOWEST_OCTAVE), part) == (error**2, 0)


def test_statistics_are_taken_only_where_the_state_says_so_and_change_nothing():
    """The counters go on all the time."""
    case, reference, samples = statistics_case(), make_reference(statistics_case(), 30), 30
    counted = kernel(case, samples)
    p = pointing.build_ensemble(case)
    state = pointing.build_state(case, p, 100, make_start(case), reference[0])
    state.place[kernels.COUNTING] = 0
    silent = pointing.run_kernel(case, 100, make_start(case), reference, state)
    assert_array_equal(silent.residual, counted.residual)
    assert_array_equal(state.counts, counted.state.counts)
    for name in STATISTICS:
        assert not getattr(state, name).any()
        assert getattr(counted.state, name).any()


# ------------------------------------------------------------------------------------------------ slices and batches

MEMORY = [name for name in kernels.EnsembleState._fields if name not in ("first_run", "x_next", "xc_next", "work")]


@pytest.mark.parametrize("cuts", [(0, 30), (1, 2, 3), (7, 7, 22)])
def test_a_run_in_several_calls_is_one_run_bit_for_bit(cuts):
    case, samples = statistics_case(), 30
    reference = make_reference(case, samples)
    whole = kernel(case, samples)
    state, pieces = None, []
    for begin, end in pairwise((0, *cuts, samples)):
        piece = pointing.run_kernel(case, 100, make_start(case), reference[begin : end + 1], state)
        pieces.append(piece)
        state = piece.state
    assert_array_equal(np.concatenate([piece.residual for piece in pieces]), whole.residual)
    assert_array_equal(np.concatenate([piece.trace for piece in pieces]), whole.trace)
    for name in MEMORY:
        assert_array_equal(getattr(state, name), getattr(whole.state, name), err_msg=name)


@pytest.mark.promise("readme-19")
def test_a_run_does_not_depend_on_its_batch_bit_for_bit():
    case, samples, i = statistics_case(), 30, 41
    start, reference = make_start(case), make_reference(case, samples)
    batch = pointing.run_kernel(case, 100, start, reference)
    alone = pointing.run_kernel(case, 100 + i, np.roll(start, -i, axis=1), reference)
    assert_array_equal(alone.residual[:, :, 0], batch.residual[:, :, i])
    assert_array_equal(alone.trace[:, :, 0], batch.trace[:, :, i])
    for name in ("sum", "sum_square", "largest", "counts"):
        assert_array_equal(alone.lines(name)[:, 0], batch.lines(name)[:, i])
    assert_array_equal(alone.state.histogram[0], batch.state.histogram[i])


def test_shifted_random_numbers_are_those_of_the_twin():
    """The shift lies inside the run, so that both its begin and its end are seen; two directions, sizes by run."""
    case, samples, steps = statistics_case(), 30, statistics_case().loop.steps_per_sample
    rng, start, reference = np.random.default_rng(5), make_start(case), make_reference(case, samples)
    numbers, outputs, directions = len(case.purpose), case.axes + len(case.mirror.C), 2
    step, sample = rng.normal(size=(9 * steps, numbers, directions)), rng.normal(size=(11, outputs, directions))
    step[rng.random(step.shape) < 0.3] = 0.0
    sizes = rng.normal(size=(directions, LANES))
    shift = kernels.Shift(12, step, sample, sizes.ravel())
    shifted, plain = pointing.run_kernel(case, 100, start, reference, shift=shift), kernel(case, samples)
    lanes = (0, 37)
    found = []
    for lane in lanes:
        of_run = shift._replace(size=sizes[:, lane])
        found.append(pointing.run_twin(case, 100 + lane, start[:, lane], reference, of_run))
    assert_same(shifted, found, lanes)
    assert_array_equal(shifted.residual[:13], plain.residual[:13])
    assert np.all(shifted.residual[14:] != plain.residual[14:])


def test_a_shift_of_size_zero_changes_nothing():
    case, samples = statistics_case(), 30
    numbers, outputs = len(case.purpose), case.axes + len(case.mirror.C)
    ones = np.ones((20, numbers, 1)), np.ones((20, outputs, 1))
    still = kernels.Shift(3, *ones, np.zeros(LANES))
    moved = still._replace(size=np.full(LANES, 1e-9))
    plain, *others = (
        pointing.run_kernel(case, 100, make_start(case), make_reference(case, samples), shift=shift)
        for shift in (kernels.UNSHIFTED, still, moved)
    )
    assert_array_equal(others[0].residual, plain.residual)
    assert not np.array_equal(others[1].residual, plain.residual)


def test_residual_and_trace_without_rows_are_left_out_and_change_nothing():
    case, samples = statistics_case(), 30
    reference, nothing = make_reference(case, samples), np.empty((0, 0, 0))
    whole = kernel(case, samples)
    p = pointing.build_ensemble(case)
    state = pointing.build_state(case, p, 100, make_start(case), reference[0])
    kernels.ensemble_loop(p, state, reference[..., None], nothing, nothing, kernels.UNSHIFTED)
    for name in kernels.EnsembleState._fields:
        assert_array_equal(getattr(state, name), getattr(whole.state, name), err_msg=name)


@pytest.mark.parametrize("seed", range(6))
def test_nothing_is_written_beyond_the_arrays_of_the_state(seed):
    """Each array lies between two fences; the arrays of the loop are only read."""
    case = statistics_case() if seed == 0 else random_pointing(seed)
    reference, fence = make_reference(case, 20), 3 * LANES
    p = pointing.build_ensemble(case)
    state = pointing.build_state(case, p, 100, make_start(case), reference[0])
    fenced, buffers = {}, {}
    for name, values in state._asdict().items():
        buffers[name] = np.full(values.size + 2 * fence, 77, dtype=values.dtype)
        fenced[name] = buffers[name][fence:-fence].reshape(values.shape)
        fenced[name][...] = values
    before = [np.array(field) for field in p if isinstance(field, np.ndarray)]
    nothing = np.empty((0, 0, 0))
    kernels.ensemble_loop(p, state._replace(**fenced), reference[..., None], nothing, nothing, kernels.UNSHIFTED)
    for name, buffer in buffers.items():
        assert np.all(buffer[:fence] == 77), name
        assert np.all(buffer[-fence:] == 77), name
    assert_array_equal(fenced["error"], kernel(case, 20).state.error)
    for ours, found in zip(before, [field for field in p if isinstance(field, np.ndarray)], strict=True):
        assert_array_equal(ours, found)


# ------------------------------------------------------------------------------------------------ without the compiler


def battery():
    """A few samples of the loop with everything, for a run without the compiler."""
    run = kernel(statistics_case(), 4)
    fields = run.state._asdict()
    return {"residual": run.residual, "trace": run.trace, **{name: fields[name] for name in (*STATISTICS, "counts")}}


def test_the_kernel_runs_as_it_is_without_the_compiler(tmp_path):
    script = (
        "import sys, warnings, numba, numpy as np, test_ensemble_kernel as test\n"
        "assert numba.config.DISABLE_JIT and not hasattr(test.kernels.ensemble_loop, 'py_func')\n"
        "warnings.simplefilter('error')\n"
        "np.savez(sys.argv[1], **test.battery())\n"
    )
    path = tmp_path / "uncompiled.npz"
    environment = os.environ | {
        "NUMBA_DISABLE_JIT": "1",
        "PYTHONPATH": os.pathsep.join([str(TESTS), str(TESTS / "core")]),
    }
    done = subprocess.run(
        [sys.executable, "-c", script, str(path)], env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    with np.load(path) as uncompiled:
        for name, values in battery().items():
            close(uncompiled[name], values)
    assert hasattr(kernels.ensemble_loop, "py_func")
