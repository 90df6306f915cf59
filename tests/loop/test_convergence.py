"""The step converges to the continuous plant at the order it claims."""

import numpy as np
import pytest

import oracles
from oracles import BoucWen, compose

# m y'' + c y' + k y + z = u, z' = alpha y' - beta (gamma |y'| z + delta y' |z|): the Bouc-Wen benchmark of Noël and
# Schoukens (2016) with m 2, c 10, k 5e4, alpha 5e4, beta 1e3, gamma 0.8, delta -1.1.
OSCILLATOR = compose(
    states=2,
    A=[[0.0, 1.0], [-5e4 / 2, -10 / 2]],
    B=[[0.0], [1 / 2]],
    E=[[0.0], [-1 / 2]],
    F=[[1.0, 0.0]],
    C=[[1.0, 0.0]],
    bouc_wen=[BoucWen(0.0, 0.0, 5e4, 0.0, 1e3 * 0.8, 1e3 * -1.1, np.inf, 0.0)],
)

PAPER = BoucWen(0.089, 0.0, -0.048, 4.7e-4, 38.421, 34.635, np.inf, 6.0)
W, DAMPING = 2 * np.pi * 900, 0.2
RESONANCE = {"states": 2, "A": [[0.0, 1.0], [-(W**2), -2 * DAMPING * W]], "C": [[1.0, 0.0]], "bouc_wen": [PAPER]}
CASCADE = compose(**RESONANCE, E=[[0.0], [W**2]], G=1.0)
GENERAL = BoucWen(0.089, 0.0, -0.022, 4.7e-4, 2.4, 0.6, np.inf, 6.0, 0.5, -0.7, 2.0)  # asymmetric, exponent 2
POWERED = CASCADE._replace(bouc_wen=(GENERAL,))
FED_BACK = compose(**RESONANCE, B=[[0.0], [0.05 * W**2]], E=[[0.0], [0.3 * W**2]], F=[[2.0, 0.0]], G=0.7)


def two_sines(amplitude, *freqs_hz):
    """A drive that starts from rest with zero rate, and its rate; its reversals fall on no grid."""
    w = 2 * np.pi * np.array(freqs_hz)
    return (
        lambda t: np.array([amplitude * np.sum(1 - np.cos(w * t)) / 2]),
        lambda t: np.array([amplitude * np.sum(w * np.sin(w * t)) / 2]),
    )


def errors(mirror, drive, drive_rate, coarse_step_s, intervals):
    """Largest error over the coarse grid, as a share of the largest output, for steps of coarse / FINER."""
    times = coarse_step_s * np.arange(intervals + 1)
    expected = oracles.reference_solution(mirror, drive, drive_rate, times)
    shares = []
    for finer in FINER:
        step_s = coarse_step_s / finer
        u = np.array([drive(t) for t in step_s * np.arange(1, intervals * finer + 1)])
        y = oracles.run_open_loop(mirror, step_s, u)[0][finer - 1 :: finer]
        shares.append(np.max(np.abs(y - expected[1:])) / np.max(np.abs(expected)))
    return np.array(shares)


def order(shares):
    """Slope of the logarithm of the error over the logarithm of the step."""
    return -np.polyfit(np.log(FINER), np.log(shares), 1)[0]


FINER = np.array([1, 2, 3, 4, 6, 8, 11, 16, 23, 32])
SLOW, FAST, HALF_SINE = two_sines(120.0, 17.3, 31.1), two_sines(6.0, 61.3, 100.7), two_sines(6.0, 50.0)
with_reversals, without_reversals = (1.8, 2.3), (1.95, 2.05)
CASES = {
    "oscillator": (OSCILLATOR, SLOW, 1 / 1500, 150, with_reversals),
    "cascade": (CASCADE, FAST, 1 / 25_000, 400, with_reversals),
    "cascade, exponent 2": (POWERED, FAST, 1 / 25_000, 400, with_reversals),
    "fed back": (FED_BACK, FAST, 1 / 25_000, 400, with_reversals),
    "cascade, rising drive": (CASCADE, HALF_SINE, 1 / 25_000, 240, without_reversals),
}
PARTS = ("cascade", "cascade, exponent 2")
"""A mirror whose order is seen without reversals, too, and one that differs from it by a power."""


@pytest.mark.promise("hysteresis-21")
@pytest.mark.parametrize(
    "case",
    [pytest.param(case, id=name, marks=pytest.mark.endurance if name in PARTS else []) for name, case in CASES.items()],
)
def test_the_step_is_of_second_order(case):
    """Two, by a fit over many steps.

    Where q turns back within a step the step misses the tip: an error of second order too, but of a size that depends
    on where in the step the tip falls, so that from one step to the next the order scatters between about -1 and 5.
    Without a reversal it is 2.00 from each step to the next.
    """
    mirror, (drive, drive_rate), coarse_step_s, intervals, (least, most) = case
    shares = errors(mirror, drive, drive_rate, coarse_step_s, intervals)
    local = -np.diff(np.log(shares)) / np.diff(np.log(FINER))
    print(f"order {order(shares):.3f}, between neighbours {np.min(local):.2f} to {np.max(local):.2f}, errors", shares)
    assert least < order(shares) < most
    assert shares[-1] < 2e-5


def test_a_gain_that_follows_the_rate_costs_an_order():
    """d1 e^(-d2 q') takes the mean rate of the step that ends: half a step late. Here 300 times the paper's d2."""
    mirror = CASCADE._replace(bouc_wen=(PAPER._replace(d2=300 * -2.96e-7),))
    shares = errors(mirror, *HALF_SINE, 1 / 25_000, 240)
    print(f"order {order(shares):.3f}", shares)
    assert 0.9 < order(shares) < 1.1
