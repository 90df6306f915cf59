"""Importance sampling of a loop's noise: runs that end in a rare radial error, each with its exact weight.

The error at the end of a run is nearly linear in the Gaussian numbers g that the run draws: along each principal axis d
of its covariance it is sigma_d <g, u_d> with an orthonormal pair of directions u_d, worked backwards through the linear
loop. A weighted run draws these two numbers anew and keeps all that is orthogonal to them:
g + sum_d (drawn_d - <g, u_d>) u_d is again standard normal when the two are drawn as such. They are drawn from a
proposal instead, another distribution in which large radii come often, and the run weighs the ratio of the two
densities. The weights are exact for any loop, with hysteresis and limits, and for any directions; only how much is
gained depends on the linear model.

The proposal goes by the level E = -ln P(radius of the linear error > rho). Standard normal numbers give an E of density
exp(-E), and given rho a direction psi of density ~ exp(kappa cos 2 psi), whatever the two sigmas are. Weighted runs
take the same direction, and E from a mixture: most from a little below the level aimed at on, some with a density that
rises from 0 to there, and a few as plain runs, which bounds the weights. So the tail is known from its begin on and
best at its aim. It is a defensive mixture: Hesterberg, Technometrics 37 (1995) 185.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from microrad.core import kernels, lti
from microrad.core.arrays import Floats
from microrad.loop.controller_study import parts
from microrad.loop.pointing_loop import ensemble, kernel_arrays, linear
from microrad.loop.pointing_loop.ensemble import SLICE_SAMPLES, Span
from microrad.loop.pointing_loop.kernel_arrays import LANES
from microrad.loop.pointing_loop.loop import LoopController, PointingLoop

STREAM = 0x54494C54
"""Second word of the key of the Philox streams that levels and directions are drawn from, behind the seed."""

KEPT_VARIANCE = 0.999
"""Share of the error's variance whose noise is drawn anew: what lies further back in time is left as it is drawn."""

FURTHEST_LEVEL = 46.0
"""Largest level aimed at, a probability of 1e-20: so far out the linear loop says nothing about the real one."""

# Shares of the runs: from a little below the level aimed at on, rising from 0 to beyond it, and as they are drawn.
AIMED, RISING, PLAIN = 0.6, 0.3, 0.1
AIM_BELOW, RISING_BEYOND = 0.25, 1.0
GROWTH = 0.15  # of the rising density with the level: small enough for the whole tail, most at what is aimed at
LEAST_VARIANCE = 1e-3  # of the larger direction's: a smaller one is left as it is drawn
_ROOT_TWO_PI = math.sqrt(2.0 * math.pi)
ANGLES = 1024  # of the mean over the circle, periodic and smooth: converged to rounding for all such directions


@dataclass(frozen=True, slots=True)
class Proposal:
    """The distribution that the noise of a loop's runs is drawn from in place of its own.

    ``step`` (plant steps, noise sources, directions) and ``sample`` (control samples, readings, directions) are the
    directions u from the control sample ``first_sample`` to the end of the run, as `kernels.Shift` takes them, and
    ``sigma_rad`` (directions,) the error that the linear loop makes of a unit along each, falling. Most runs are
    drawn beyond the level ``begin``, others up to ``end``; an ``end`` of 0 leaves the noise as it is.
    """

    first_sample: int
    step: Floats
    sample: Floats
    sigma_rad: Floats
    begin: float
    end: float

    def log_density(self, level: Floats) -> Floats:
        """Logarithm of the density that the levels of weighted runs have."""
        aimed = np.where(level >= self.begin, AIMED * np.exp(self.begin - level), 0.0)
        growth = RISING * GROWTH / math.expm1(GROWTH * self.end)
        rising = np.where(level < self.end, growth * np.exp(GROWTH * np.minimum(level, self.end)), 0.0)
        return np.asarray(np.log(aimed + rising + PLAIN * np.exp(-level)))


def proposal(loop: PointingLoop, controller: LoopController, span: Span, error_rad: float) -> Proposal:
    """The proposal that favours a radial error at the end of runs.

    That end is the end of the last control sample, so a span needs no more than the settling time and the loop's
    memory: in a stationary loop the probability there is the share of the time. A batch of plain runs tells how far the
    loop follows its linear model, which decides on the levels. Raises ValueError for an unstable loop, and where no
    random noise reaches the error.

    Args:
        loop: the loop.
        controller: its controller.
        span: how long the runs are, and their seed.
        error_rad: the error (rad); 0 gives plain runs.
    """
    closed = linear.close(loop, controller)
    linear.refuse_unstable(closed)
    total, _ = ensemble.control_samples(loop, span)
    step, sample = _backwards(closed, total)
    covariance = np.einsum("kwa,kwb->ab", step, step) + np.einsum("kwa,kwb->ab", sample, sample)
    variance, principal = lti.principal_axes(covariance)
    used = np.flatnonzero(variance > LEAST_VARIANCE * max(float(variance[-1]), 1e-300))[::-1]
    if not used.size:
        raise ValueError("no random noise reaches the line of sight of this loop: there is no tail to sample")
    sigma = np.sqrt(variance[used])
    turn = principal[:, used] / sigma
    begin, end = (0.0, 0.0) if error_rad <= 0.0 else _aim(loop, controller, span, error_rad, sigma)
    return Proposal(
        first_sample=total - sample.shape[0],
        step=np.ascontiguousarray(step @ turn),
        sample=np.ascontiguousarray(sample @ turn),
        sigma_rad=sigma,
        begin=begin,
        end=end,
    )


def _levels(
    pilot: Floats, linear_pilot: Floats, lines_rad: float, error_rad: float, sigma_rad: Floats
) -> tuple[float, float]:
    """Where the levels of the aimed runs begin, and where those of the rising share end.

    By linear regression of the linear loop's error on the loop's own: where that is ``error_rad``, the linear one is
    some radius on average, with some scatter, of which the levels cover two standard deviations to both sides. Lines
    may make it alone up to their amplitude.
    """
    square, together = float(np.mean(pilot**2)), float(np.mean(pilot * linear_pilot))
    at = error_rad * max(together / square, 0.0)
    scatter = math.sqrt(max(float(np.mean(linear_pilot**2)) - together**2 / square, 0.0))
    radius = np.array([max(at - 2.0 * scatter - lines_rad, 0.0), at + 2.0 * scatter])
    low, high = np.minimum(level_of(radius, sigma_rad)[0], FURTHEST_LEVEL).tolist()
    return max(low - AIM_BELOW, 0.0), high + RISING_BEYOND


def _aim(
    loop: PointingLoop, controller: LoopController, span: Span, error_rad: float, sigma_rad: Floats
) -> tuple[float, float]:
    """`_levels` from one batch of the loop and of its linear model with the same random numbers, of another seed."""
    other = replace(span, seed=span.seed ^ STREAM)
    straight = parts.without(loop, parts.REFERENCE, parts.HYSTERESIS, parts.QUANTISATION, parts.LIMITS)
    follower = linear.straightened(controller, loop)
    errors = _pilot(loop, controller, other), _pilot(straight, follower, other)
    return _levels(*errors, _lines_rad(linear.close(loop, controller)), error_rad, sigma_rad)


def _lines_rad(closed: linear.ClosedLoop) -> float:
    """Radial amplitude of what the disturbances with lines leave in the linear loop."""
    names = {line.name for line in closed.open.lines}
    left = linear.stationary(closed).error_by_source if names else {}
    return math.sqrt(2.0 * sum(float(np.sum(left[name])) for name in names))


def _pilot(loop: PointingLoop, controller: LoopController, span: Span) -> Floats:
    """Errors (samples, axes, LANES) of one batch behind the settling time, at most a slice of them."""
    total, settle = ensemble.control_samples(loop, span)
    p = kernel_arrays.arrays(loop, controller, span.seed)
    state, nothing = kernel_arrays.start(loop, p, 0), np.empty((0, 0, 0))
    end = min(total, settle + SLICE_SAMPLES)
    error = np.empty((end - settle, loop.axes, LANES))
    for at, until in pairwise([*range(0, settle, SLICE_SAMPLES), settle, end]):
        kept = error if until == end else nothing
        kernels.ensemble_loop(p, state, kernel_arrays.reference(loop, at, until), kept, nothing, kernels.UNSHIFTED)
    return error


def level_of(radius_rad: Floats, sigma_rad: Floats) -> tuple[Floats, Floats]:
    """Level -ln P(r > radius) of independent Gaussian errors along one or two axes, and its slope (1/rad).

    P is the mean over the unit circle of exp(-(radius / s)^2 / 2) with s^2 = (sigma_1 cos)^2 + (sigma_2 sin)^2: along
    each direction of the circle the unit errors exceed radius / s. For one axis it is that of the normal distribution.

    Args:
        radius_rad: radii (n,) in rad.
        sigma_rad: standard deviations (axes,) in rad.
    """
    from scipy.special import log_ndtr

    if sigma_rad.size == 1:
        unit = radius_rad / sigma_rad[0]
        log_beyond = log_ndtr(-unit)
        return -log_beyond - math.log(2.0), np.exp(-0.5 * unit**2 - log_beyond) / (sigma_rad[0] * _ROOT_TWO_PI)
    angle = 2.0 * np.pi * (np.arange(ANGLES) + 0.5) / ANGLES
    inverse = 1.0 / ((sigma_rad[0] * np.cos(angle)) ** 2 + (sigma_rad[1] * np.sin(angle)) ** 2)
    exponent = -0.5 * radius_rad[:, None] ** 2 * inverse
    largest = exponent.max(axis=1)
    terms = np.exp(exponent - largest[:, None])
    level = -largest - np.log(np.mean(terms, axis=1))
    return level, radius_rad * np.sum(terms * inverse, axis=1) / np.sum(terms, axis=1)


def radius_of(level: Floats, sigma_rad: Floats) -> Floats:
    """Radius of each level, by Newton's method from above: the level is convex in the radius.

    Args:
        level: levels (n,), at least 0.
        sigma_rad: standard deviations (axes,) in rad, the largest first.
    """
    radius: Floats = sigma_rad[0] * np.sqrt(2.0 * level)
    for _ in range(100):
        found, slope = level_of(radius, sigma_rad)
        if np.all(np.abs(found - level) <= 1e-13 * (1.0 + level)):
            break
        radius = np.maximum(radius - (found - level) / np.maximum(slope, 1e-300), 0.5 * radius)
    return radius


def _backwards(closed: linear.ClosedLoop, total: int) -> tuple[Floats, Floats]:
    """What a unit of each random number does to the error at the end of a run of ``total`` control samples.

    By plant step (steps, sources, axes) and by control sample (samples, readings, axes), in the order of time, so far
    back that they hold `KEPT_VARIANCE` of the stationary variance at the run's end.
    """
    o = closed.open
    wanted = KEPT_VARIANCE * float(np.trace(end_covariance(closed, total)))
    reach = np.zeros((o.error.shape[0], closed.step_noise.shape[0]))
    reach[:, : o.at.order] = o.error
    ahead, blocks = _through_steps(closed)
    steps, samples, found = [], [], 0.0
    for k in range(total - 1, -1, -1):
        steps.append((reach @ blocks).reshape(reach.shape[0], len(closed.steps), -1))
        reach = reach @ ahead
        phase = k % len(closed.samples)
        samples.append(reach @ closed.sample_noise[phase])
        reach = reach @ closed.samples[phase]
        found += float(np.sum(steps[-1] ** 2) + np.sum(samples[-1] ** 2))
        if found >= wanted:
            break
    by_step = np.concatenate([each.transpose(1, 2, 0) for each in reversed(steps)])
    return by_step, np.stack([each.T for each in reversed(samples)])


def _through_steps(closed: linear.ClosedLoop) -> tuple[Floats, Floats]:
    """The map of all plant steps of a control sample, and what each one's noise is at its end, side by side."""
    ahead, blocks = np.eye(closed.step_noise.shape[0]), []
    for step in reversed(closed.steps):
        blocks.append(ahead @ closed.step_noise)
        ahead = ahead @ step
    return ahead, np.hstack(blocks[::-1])


def end_covariance(closed: linear.ClosedLoop, total: int) -> Floats:
    """Stationary covariance (axes, axes) in rad^2 of the error at the end of a run.

    That of the noise: lines are left out. Raises ValueError for an unstable loop.

    Args:
        closed: the linear loop.
        total: control samples of the run.
    """
    linear.refuse_unstable(closed)
    o, whole = closed.open, closed.step_noise.shape[0]

    def onward(P: Floats, samples: int) -> Floats:
        for sample, noise in zip(closed.samples[:samples], closed.sample_noise, strict=False):
            P = sample @ P @ sample.T + noise @ noise.T
            for step in closed.steps:
                P = step @ P @ step.T + closed.step_noise @ closed.step_noise.T
        return P

    period = len(closed.samples)
    before = lti.gramian(closed.monodromy.T, onward(np.zeros((whole, whole)), period))
    at_end = onward(before, (total - 1) % period + 1)[: o.at.order, : o.at.order]
    return np.asarray(o.error @ at_end @ o.error.T)


def runs(
    loop: PointingLoop,
    controller: LoopController,
    span: Span,
    by: Proposal,
    first_run: int,
    beat: Callable[[], None] = lambda: None,
) -> tuple[Floats, Floats]:
    """Radial error (rad) at the end of LANES runs, and the logarithm of their weights.

    The mean over runs of weight times 1(error > x) is the probability of an error beyond x. The numbers go by the seed
    and the run's number alone.

    Args:
        loop: the loop.
        controller: its controller.
        span: how long the runs are, and their seed.
        by: what their noise is drawn from.
        first_run: number of the first of them.
        beat: called between slices of compiled code; ends the runs by raising.
    """
    p = kernel_arrays.arrays(loop, controller, span.seed)
    state = kernel_arrays.start(loop, p, first_run)
    total, _ = ensemble.control_samples(loop, span)
    along, log_weight = drawn(by, span.seed, first_run)
    shift = kernels.UNSHIFTED
    if by.end > 0.0:
        size = along - _projections(p, by, state.first_run)
        shift = kernels.Shift(by.first_sample, by.step, by.sample, np.ascontiguousarray(size).ravel())
    nothing = np.empty((0, 0, 0))
    for at in range(0, total, SLICE_SAMPLES):
        beat()
        end = min(at + SLICE_SAMPLES, total)
        kernels.ensemble_loop(p, state, kernel_arrays.reference(loop, at, end), nothing, nothing, shift)
    error = state.error.reshape(-1, LANES)[: loop.axes]
    return np.asarray(np.sqrt(np.sum(error**2, axis=0))), log_weight


def drawn(by: Proposal, seed: int, first_run: int) -> tuple[Floats, Floats]:
    """What each of LANES runs has along the directions, (directions, LANES), and the logarithm of its weight.

    Args:
        by: what the noise is drawn from.
        seed: the campaign's.
        first_run: number of the first run.
    """
    if by.end == 0.0:
        return np.zeros((by.sigma_rad.size, LANES)), np.zeros(LANES)
    streams = [
        np.random.Generator(np.random.Philox(key=seed | STREAM << 64, counter=run << 64))
        for run in range(first_run, first_run + LANES)
    ]
    level = np.array([_draw_level(by, rng) for rng in streams])
    radius = radius_of(level, by.sigma_rad)
    unit = np.array([_draw_unit(r, by.sigma_rad, rng) for r, rng in zip(radius.tolist(), streams, strict=True)])
    return unit.T, -level - by.log_density(level)


def _draw_level(by: Proposal, rng: np.random.Generator) -> float:
    share = rng.random()
    if share < RISING:
        return math.log1p(rng.random() * math.expm1(GROWTH * by.end)) / GROWTH
    return rng.exponential() + (by.begin if share < RISING + AIMED else 0.0)


def _draw_unit(radius_rad: float, sigma_rad: Floats, rng: np.random.Generator) -> Floats:
    """Standard normal numbers along the directions, given the radius of the error that they make.

    Of two directions the error's angle psi has a density ~ exp(kappa cos 2 psi): 2 psi is von Mises, and psi or the
    opposite equally likely.
    """
    sign = 1.0 if rng.random() < 0.5 else -1.0
    if sigma_rad.size == 1:
        return sign * radius_rad / sigma_rad
    kappa = 0.25 * radius_rad**2 * (sigma_rad[1] ** -2 - sigma_rad[0] ** -2)
    angle = 0.5 * rng.vonmises(0.0, kappa)
    return np.asarray(sign * radius_rad * np.array([math.cos(angle), math.sin(angle)]) / sigma_rad)


def _projections(p: kernels.Ensemble, by: Proposal, runs: NDArray[np.uint64]) -> Floats:
    """<g, u> of the numbers that the runs draw by themselves: (directions, LANES)."""
    found = np.zeros((by.sigma_rad.size, LANES))
    for source, purpose in enumerate(p.purpose):
        found += _projected(p.seed, runs, purpose, by.first_sample * p.steps_per_sample, by.step[:, source])
    for reading in range(by.sample.shape[1]):
        purpose = np.uint64(kernels.SENSOR_PURPOSE + reading // 4)
        of_word = np.zeros((4 * by.sample.shape[0], by.sigma_rad.size))
        of_word[reading % 4 :: 4] = by.sample[:, reading]
        found += _projected(p.seed, runs, purpose, 4 * by.first_sample, of_word)
    return found


def _projected(seed: NDArray[np.uint64], runs: NDArray[np.uint64], purpose: np.uint64, first: int, u: Floats) -> Floats:
    """Sum of u[k] (numbers, directions) times the stream's number ``first`` + k: (directions, LANES)."""
    found = np.zeros((u.shape[1], LANES))
    for at in range(first - first % 4, first + u.shape[0], SLICE_SAMPLES):
        numbers = np.empty(SLICE_SAMPLES * LANES)
        kernels.gaussian_kernel(seed, runs, purpose, at // 4, numbers)
        begin, end = max(at, first), min(at + SLICE_SAMPLES, first + u.shape[0])
        found += u[begin - first : end - first].T @ numbers.reshape(-1, LANES)[begin - at : end - at]
    return found
