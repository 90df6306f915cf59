"""The linear loop's error in time windows: against sums by hand, the motion without a loop, and drawn runs."""

import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from microrad.loop.disturbance import Disturbance, SpectralLine, first_order
from microrad.loop.disturbance.windows import ErrorIndex, recorded_rms, windowed_rms
from microrad.loop.pointing_loop.linear import close, stationary
from microrad.loop.pointing_loop.windows import windowed
from microrad.loop.workbench import Controller, Loop
from microrad.mirror.model import Mirror

MIRROR = Mirror.of(50e-6, [1.0], [1 / 3000**2, 2 * 0.1 / 3000, 1.0])
SLOW = first_order(160e-12, 5.0, convention="per-axis", name="vibration")
LINES = Disturbance(
    "wheel", np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), (SpectralLine(2e-6, 30.0),), "line", "test"
)
LOOP = Loop(mirror=MIRROR, rate_hz=1000.0, vibration=(SLOW, LINES), sensor_noise_rad=0.5e-6, delay_s=2e-4)
OPEN, TRACKING = (Controller.pid(0.0, gain, rate_hz=1000.0) for gain in (0.0, 5e5))
INDICES = (
    ErrorIndex("MPE", 0.005),
    ErrorIndex("RPE", 0.005),
    ErrorIndex("PDE", 0.005, 0.007),
    ErrorIndex("PDE", 0.005, 0.002),
)


def closed(loop=LOOP, controller=TRACKING):
    return close(loop.parts, loop.assembled(controller))


def slow_sensor():
    """The same loop read every third sample."""
    return replace(LOOP.parts, optical=replace(LOOP.parts.optical, every=3))


def variances(found):
    return {name: float(each[0]) for name, each in found.items()}


def test_all_of_the_error_is_what_linear_theory_says():
    for each in (closed(), close(slow_sensor(), LOOP.assembled(TRACKING))):
        theory = {name: float(value[0]) for name, value in stationary(each).error_by_source.items()}
        found = variances(windowed(each, ErrorIndex("APE")))
        assert found.keys() == theory.keys()
        assert_allclose([*found.values()], [*theory.values()], rtol=1e-12)
        for window in (0.003, 0.3, 30.0):
            mean, left = (variances(windowed(each, ErrorIndex(kind, window))) for kind in ("MPE", "RPE"))
            assert_allclose([mean[n] + left[n] for n in theory], [*theory.values()], rtol=1e-12)


@pytest.mark.promise("pointing-35")
@pytest.mark.parametrize("every", [1, 3])
def test_a_window_is_a_sum_over_all_pairs_of_plant_steps(every):
    """Each state's covariance with each later one, step by step, for the noise of the sensor and of the vibration."""
    parts = LOOP.parts if every == 1 else slow_sensor()
    each = close(parts, LOOP.assembled(TRACKING))
    readings, apart = 6 // every, 9 // every
    maps = []
    for sample, noise in zip(each.samples, each.sample_noise, strict=True):
        maps.append((sample, noise, None))
        maps += [(step, None, each.step_noise) for step in each.steps]
    error = np.zeros((1, len(each.step_noise)))
    error[:, : each.open.at.order] = each.open.error
    for source in each.sources:
        if source.name not in ("vibration", "optical sensor noise"):
            continue

        def added(sampled, stepped, source=source):
            noise = sampled if source.sampled else stepped
            return 0.0 if noise is None else noise[:, source.columns] @ noise[:, source.columns].T

        P = np.zeros((len(each.step_noise),) * 2)
        for _ in range(400):  # settled: 400 readings are many time constants of the loop and of its vibration
            for matrix, sampled, stepped in maps:
                P = matrix @ P @ matrix.T + added(sampled, stepped)
        weights = {
            "MPE": np.concatenate([np.ones(readings), np.zeros(apart)]),
            "PDE": np.concatenate([np.ones(readings), np.zeros(apart)])
            - np.concatenate([np.zeros(apart), np.ones(readings)]),
        }
        times = 0.001 * every * readings, 0.001 * every * apart
        for kind, weight in weights.items():
            total = 0.0
            joint = P.copy()
            summed = np.zeros(len(P))  # covariance of the state with the sum so far
            for w in weight:
                for matrix, sampled, stepped in maps:
                    joint = matrix @ joint @ matrix.T + added(sampled, stepped)
                    summed = matrix @ summed
                    if sampled is None:
                        total += w * w * (error @ joint @ error.T).item() + 2 * w * (error @ summed).item()
                        summed = summed + w * (joint @ error.T)[:, 0]
            steps = readings * every * len(each.steps)
            index = ErrorIndex(kind, *times[: 1 + (kind == "PDE")])
            assert windowed(each, index)[source.name][0] == pytest.approx(total / steps**2, rel=1e-6, abs=0.0)


def test_without_a_loop_the_error_is_the_motion():
    """Within the difference of a mean of plant steps to the integral: a step of 0.1 ms against 5 Hz and 30 Hz."""
    each = closed(controller=OPEN)
    for index in (*INDICES, ErrorIndex("MPE", 1.0), ErrorIndex("PDE", 1.0, 3.0), ErrorIndex("RPE", 1.0)):
        found = variances(windowed(each, index))
        assert math.sqrt(found["vibration"]) == pytest.approx(windowed_rms(SLOW, index), rel=0.02, abs=0.0)
        assert math.sqrt(found["wheel"]) == pytest.approx(windowed_rms(LINES, index), rel=0.02, abs=1e-9)
        assert found["optical sensor noise"] == 0.0


def test_runs_have_the_indices_of_linear_theory():
    each = closed()
    runs = [LOOP.simulate(TRACKING, 6.0, seed=seed).error_rad[1000:, 0] for seed in range(24)]
    for index in INDICES:
        squares = [recorded_rms(run, 0.001, index) ** 2 for run in runs]
        theory = sum(variances(windowed(each, index)).values())
        error = np.std(squares, ddof=1) / math.sqrt(len(squares))
        # A run is seen at its control samples, and theory at all plant steps: at most a sixtieth of a line's period.
        assert abs(np.mean(squares) - theory) < 4.5 * error + 0.03 * theory
        assert error < 0.1 * theory


def test_windows_of_any_length_and_loops_that_have_none():
    each = closed()
    long = variances(windowed(each, ErrorIndex("MPE", 1e6)))
    assert 0.0 < sum(long.values()) < 1e-17
    with pytest.raises(ValueError, match=r"window_s of MPE is 0\.0001 s, and the sensor reads every 0\.001 s"):
        windowed(each, ErrorIndex("MPE", 1e-4))
    with pytest.raises(ValueError, match="is unstable: a pole at"):
        windowed(closed(controller=Controller.pid(0.0, 5e7, rate_hz=1000.0)), ErrorIndex("APE"))
