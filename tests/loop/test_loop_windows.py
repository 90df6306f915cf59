"""The linear loop's error in time windows: against sums by hand, the motion without a loop, and drawn runs."""

import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from microrad.loop.disturbance import Disturbance, SpectralLine, first_order
from microrad.loop.disturbance.windows import ErrorIndex, rational_rms, recorded_rms, windowed_rms
from microrad.loop.pointing_loop import windows
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


def hand_span(F, Q):
    return windows._Span(np.array(F), np.array(Q))


@pytest.mark.parametrize("count", [0, 1, 2, 5, 8, 13])
def test_a_span_of_many_readings_is_each_behind_the_other(count):
    one = hand_span([[0.9, 0.2], [-0.1, 0.7]], [[1.0, 0.3], [0.3, 2.0]])
    F, Q = np.eye(2), np.zeros((2, 2))
    for _ in range(count):
        F, Q = one.F @ F, one.F @ Q @ one.F.T + one.Q
    found = one.times(count)
    assert_allclose(found.F, F, rtol=1e-12)
    assert_allclose(found.Q, Q, rtol=1e-12)
    later = hand_span([[0.0, 1.0], [1.0, 0.5]], np.eye(2))
    both = one.then(later)
    assert_allclose(both.F, later.F @ one.F)
    assert_allclose(both.Q, later.F @ one.Q @ later.F.T + np.eye(2))


@pytest.mark.parametrize("sign", [0.0, -1.0])
def test_sums_are_added_with_a_sign_and_are_kept_themselves(sign):
    one = hand_span([[0.9, 0.2, 0.0], [-0.1, 0.7, 0.0], [3.0, 4.0, 1.0]], np.arange(9.0).reshape(3, 3))
    found = windows._signed(one, 1, sign)
    assert_allclose(found.F, [[0.9, 0.2, 0.0], [-0.1, 0.7, 0.0], [3.0 * sign, 4.0 * sign, 1.0]])
    assert_allclose(found.Q, [[0.0, 1.0, 2.0 * sign], [3.0, 4.0, 5.0 * sign], [6.0 * sign, 7.0 * sign, 8.0 * sign**2]])


@pytest.mark.parametrize(
    ("index", "every", "readings"),
    [(ErrorIndex("APE"), 1, (0, 0)), (ErrorIndex("MPE", 0.0104), 1, (10, 0)),
     (ErrorIndex("PDE", 0.0104, 0.0016), 1, (10, 2)),
     (ErrorIndex("PRE", 0.0104, 0.0046), 3, (3, 2)), (ErrorIndex("RKE", 0.00151), 3, (1, 0))],
)  # fmt: skip
def test_times_of_an_index_are_whole_readings_of_the_sensor(index, every, readings):
    loop = replace(LOOP.parts, optical=replace(LOOP.parts.optical, every=every))
    assert windows.readings_of(loop, index) == readings


@pytest.mark.parametrize(
    ("index", "words"),
    [(ErrorIndex("PDE", 0.01, 0.0014), "spacing_s of PDE is 0.0014 s, and the sensor reads every 0.003 s: give more"),
     (ErrorIndex("RKE", 0.0014), "window_s of RKE is 0.0014 s, and the sensor reads every 0.003 s: give more")],
)  # fmt: skip
def test_a_time_below_half_of_a_reading_is_refused_by_its_name(index, words):
    with pytest.raises(ValueError) as refused:
        windows.readings_of(slow_sensor(), index)
    assert str(refused.value) == words


def test_errors_in_windows_are_told_by_source_before_and_behind_the_loop():
    """Of two disturbances of one axis and a line: before by their own spectra, behind by every source of the loop."""
    indices = (ErrorIndex("MPE", 0.005), ErrorIndex("PDE", 0.005, 0.007))
    mean, drift = windows.windowed_errors(closed(), indices)
    assert (mean.index, drift.index) == indices
    for each in (mean, drift):
        assert each.before == {
            "vibration": pytest.approx(windowed_rms(SLOW, each.index)),
            "wheel": pytest.approx(windowed_rms(LINES, each.index)),
        }  # fmt: skip
        left = windowed(closed(), each.index)
        assert each.left == {name: pytest.approx(math.sqrt(max(v[0], 0.0))) for name, v in left.items()}
        assert set(each.left) == {"vibration", "wheel", "optical sensor noise", "gauge noise"}
    assert mean.rational == pytest.approx(math.hypot(*(rational_rms(d, mean.index) for d in (SLOW, LINES))))
    assert math.isnan(drift.rational)


def test_lines_and_noises_of_one_name_add_up():
    """Of a wheel with two lines, and of a vibration that is called as a line is."""
    of_two = replace(LINES, lines=(SpectralLine(2e-6, 30.0), SpectralLine(1e-6, 47.0)))
    one, other = (replace(LINES, lines=(line,)) for line in of_two.lines)
    index = ErrorIndex("RPE", 0.005)

    def left(*vibration):
        return variances(windowed(close(replace(LOOP, vibration=vibration).parts, LOOP.assembled(TRACKING)), index))

    alone = left(one)["wheel"], left(other)["wheel"], left(SLOW)["vibration"]
    assert left(of_two)["wheel"] == pytest.approx(alone[0] + alone[1], rel=1e-12)
    assert left(one, replace(SLOW, name="wheel"))["wheel"] == pytest.approx(alone[0] + alone[2], rel=1e-12)


def test_reproducibility_of_a_mean_is_told_before_and_behind_the_loop_without_a_rational_form():
    (found,) = windows.windowed_errors(closed(), (ErrorIndex("PRE", 0.005, 0.5),))
    assert math.isnan(found.rational)
    assert found.before["wheel"] == pytest.approx(windowed_rms(LINES, found.index), rel=1e-9)
    assert found.left.keys() == {"vibration", "wheel", "optical sensor noise", "gauge noise"}


@pytest.mark.parametrize("at_samples", [False, True])
@pytest.mark.parametrize(("known", "pointed"), [("AKE", "APE"), ("MKE", "MPE"), ("RKE", "RPE")])
def test_what_is_known_counts_in_a_loop_as_what_is_pointed(known, pointed, at_samples):
    each, times = closed(), () if known == "AKE" else (0.05,)
    kinds = [ErrorIndex(kind, *times) for kind in (known, pointed)]
    one, other = (windows.windowed_in_all(each, index, at_samples=at_samples) for index in kinds)
    assert one.tolist() == other.tolist()
    one, other = (variances(windowed(each, index)) for index in kinds)
    assert one == other
    (of_known,), (of_pointed,) = (windows.windowed_errors(each, [index]) for index in kinds)
    assert replace(of_known, index=kinds[1]) == of_pointed
