"""The adaptive inverse in the ensemble kernel, held against its slow twin, and what it keeps whatever it reads."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import oracle_pointing as pointing
import oracles
from microrad.core import kernels

STEP, SAMPLES, LANES = 1e-4, 700, kernels.LANES
THRESHOLDS, WEIGHTS = (0.0, 0.1, 0.3, 0.7), (0.6, 0.15, 0.15, 0.1)
LAW = pointing.Adaptive(
    thresholds=THRESHOLDS,
    weights=WEIGHTS,
    cycle=7,
    delay=2,
    gain=0.3,
    slow=0.01,
    forgotten=0.07,
    dead_zone=1e-3,
    speed=0.02,
    least_size=1e-5,
    least_travel=1e-3,
    least_weight=0.3,
    most_weight=2.0,
    offset_limit=0.2,
)
ROUNDING = 1e-9
"""The law forgets: an error of rounding (1e-15) dies away in tens of samples, save where a decision turns over."""


def loop_of(law=LAW, gain=0.8, width=1.3, gauge_noise=1e-3, blind_from=None):
    """A mirror of plays behind an inverse of the reference alone, which learns what the gauge tells beyond it.

    Its gain and the weights of its plays with a threshold are those of the law, times ``gain`` and ``width``.
    """
    weights = gain * np.array(law.weights)
    weights[1:] *= width
    weights[0] -= np.sum(weights[1:]) * (1.0 - 1.0 / width)
    mirror = oracles.compose(
        G=np.ones((1, 1)), K=np.ones((1, 1)), F=np.zeros((1, 0)), E=np.zeros((0, 1)),
        operators=(oracles.Operator(law.thresholds, tuple(weights)),),
    )  # fmt: skip
    case = pointing.quiet_pointing(mirror, STEP, np.eye(1), feedforward=True)
    # v = 0, target = reference, rate = 0, error = gauge less the reference of this sample
    D = np.zeros((4, 3))
    D[1, 2], D[3, 1], D[3, 2] = 1.0, 1.0, -1.0
    loop = case.loop._replace(Cc=np.zeros((4, 0)), Dc=D)
    return case._replace(loop=loop, adaptive=law, gauge_noise=gauge_noise)


def wave(samples=SAMPLES):
    """Two sines with a slow drift, from rest, (samples + 1, 1)."""
    t = np.arange(samples + 1) / 100.0
    return (0.5 * np.sin(7.0 * t) + 0.3 * np.sin(2.3 * t) + 0.1 * t * np.cos(0.5 * t))[:, None]


def run(case, reference):
    return pointing.run_kernel(case, 5, np.zeros((0, LANES)), reference)


def learnt(of, field, lanes=slice(None)):
    rows = of.lines("learnt")[: len(WEIGHTS) * kernels.PLAY_FIELDS]
    return rows.reshape(len(WEIGHTS), kernels.PLAY_FIELDS, LANES)[:, field, lanes]


def track(of, field, lanes=slice(None)):
    return of.lines("track")[field, lanes]


@pytest.mark.promise("hysteresis-18", "pointing-25", "pointing-26")
@pytest.mark.parametrize("gain", [0.8, 1.0])
def test_it_is_its_twin(gain):
    case, lanes = loop_of(gain=gain, gauge_noise=2e-3), [41]
    ours = run(case, wave())
    twins = [pointing.run_twin(case, 5 + lane, np.zeros(0), wave()) for lane in lanes]
    assert_allclose(ours.residual[:, 0, lanes].T, [[e[0] for e, _ in t.samples] for t in twins], atol=ROUNDING)
    fields = {
        kernels.LEARNT: [t.learning.learnt for t in twins],
        kernels.WEIGHT: [t.learning.coming for t in twins],
        kernels.MEAN: [t.learning.mean for t in twins],
        kernels.SWUNG: [t.learning.swung for t in twins],
    }
    for field, theirs in fields.items():
        assert_allclose(learnt(ours, field, lanes).T, theirs, rtol=0, atol=ROUNDING)
    names = ("slow", "offset", "misfit", "frozen_misfit", "swing", "size", "in_use")
    for name in names:
        field = getattr(kernels, name.upper())
        assert_allclose(track(ours, field, lanes), [getattr(t.learning, name) for t in twins], rtol=0, atol=ROUNDING)
    assert_array_equal(ours.lines("counts")[:, lanes].T, [t.counts() for t in twins])
    assert np.all(track(ours, kernels.IN_USE) == (gain != 1.0))


@pytest.mark.promise("pointing-26")
def test_a_frozen_inverse_that_fits_stays_as_it_is_to_the_last_bit():
    learns = run(loop_of(gain=1.0, width=1.0, gauge_noise=0.0), wave())
    assert_array_equal(learnt(learns, kernels.WEIGHT), np.array(WEIGHTS)[:, None] + np.zeros(LANES))
    assert_array_equal(track(learns, kernels.OFFSET), 0.0)
    assert_array_equal(learns.lines("counts")[kernels.COUNT_FALLBACK], 0.0)


@pytest.mark.promise("pointing-25")
def test_plays_that_nothing_moves_keep_their_weights():
    small = 0.25 * wave()  # less than the largest threshold
    found = run(loop_of(), small)
    assert_array_equal(learnt(found, kernels.LEARNT)[-1], WEIGHTS[-1])
    assert np.all(np.abs(learnt(found, kernels.LEARNT)[0] - WEIGHTS[0]) > 0.05)


@pytest.mark.promise("pointing-25")
def test_weights_move_no_faster_than_they_may():
    slow = LAW._replace(speed=1e-4)
    found = run(loop_of(slow), wave())
    looks = SAMPLES // LAW.cycle + 1
    moved = [np.max(np.abs(learnt(found, of) - np.array(WEIGHTS)[:, None])) for of in (kernels.LEARNT, kernels.WEIGHT)]
    assert 0.003 < moved[0] <= 1e-4 * looks * (1.0 + 1e-12)
    assert moved[1] <= moved[0]


@pytest.mark.promise("pointing-25")
def test_readings_that_do_not_follow_teach_nothing_and_the_frozen_inverse_stays():
    stuck = loop_of()
    stuck = stuck._replace(loop=stuck.loop._replace(Dc=stuck.loop.Dc * (np.arange(3) != 1)))  # reads 0 all the time
    found = run(stuck, wave())
    assert_array_equal(learnt(found, kernels.WEIGHT), np.array(WEIGHTS)[:, None] + np.zeros(LANES))
    assert np.max(np.abs(learnt(found, kernels.LEARNT) - np.array(WEIGHTS)[:, None])) < 0.05


@pytest.mark.promise("pointing-25")
def test_a_mirror_that_is_its_old_self_again_is_a_fallback_and_counted():
    turned = loop_of(gain=0.7)
    reference = wave(2 * SAMPLES)
    first = run(turned, reference[: SAMPLES + 1])
    assert np.all(track(first, kernels.IN_USE) == 1.0)
    back = loop_of(gain=1.0, width=1.0)
    later = pointing.run_kernel(back, 5, np.zeros((0, LANES)), reference[SAMPLES:], state=first.state)
    assert np.all(later.lines("counts")[kernels.COUNT_FALLBACK] >= 1.0)
    assert_allclose(learnt(later, kernels.WEIGHT), np.array(WEIGHTS)[:, None] + np.zeros(LANES), atol=0.02)


@pytest.mark.promise("hysteresis-18", "pointing-25")
@pytest.mark.parametrize("size", [1e3, 1e150])
def test_no_reading_takes_weights_beyond_their_limits(size):
    case = loop_of()
    D = case.loop.Dc.copy()
    D[3, 1] = -size  # a gauge of the wrong sign and size
    wild = run(case._replace(loop=case.loop._replace(Dc=D)), wave())
    for field in (kernels.LEARNT, kernels.WEIGHT):
        weights = learnt(wild, field)
        assert np.all((weights >= 0.0) & (weights <= LAW.most_weight))
        assert np.all(weights[0] >= LAW.least_weight)
    assert np.all(np.abs(track(wild, kernels.SLOW)) <= LAW.offset_limit)
