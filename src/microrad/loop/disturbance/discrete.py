"""Disturbances sampled at a fixed step: exact at the samples, few random numbers a step, any length without storage."""

import math
from dataclasses import dataclass

import numpy as np

from microrad.core import lti
from microrad.core.arrays import Floats
from microrad.loop.disturbance.records import Disturbance, above_zero, covariance

_DROPPED = 1e-6  # of the output's variance from one white input: directions of noise below it are left out


@dataclass(frozen=True, slots=True)
class Discrete:
    """x[k+1] = Ad x[k] + Bd n[k], d[k] = C x[k], with independent standard normal n.

    The first two states of each spectral line turn without damping and take no noise; the shaping filter's follow,
    pairs before single ones. ``initial`` (states, states) turns standard normal numbers into a stationary start of the
    filter and leaves the lines at zero; a line's start is its ``line_amplitude_rad`` at a random phase.
    """

    Ad: Floats
    Bd: Floats
    C: Floats
    initial: Floats
    line_amplitude_rad: Floats


def discretise(disturbance: Disturbance, step_s: float) -> Discrete:
    """The disturbance at multiples of a step.

    The noise of each white input over a step is integrated exactly (Van Loan 1978). Of its directions, those that give
    less than 1e-6 of that input's output variance are left out, and the rest scaled so that the variance of the output
    stays exact: a slow filter of any order takes one random number a step. What is lost lies near half the sample rate.

    Args:
        disturbance: The disturbance, continuous in time.
        step_s: Length of a step.

    Raises:
        ValueError: For a step that is not above zero and for a line at or above half the sample rate.
    """
    above_zero(step_s, "step of a sampled disturbance", "s")
    for line in disturbance.lines:
        if line.freq_hz * step_s >= 0.5:
            raise ValueError(
                f'"{disturbance.name}": a line at {line.freq_hz:g} Hz cannot be sampled every {step_s:g} s, which ends '
                f"at {0.5 / step_s:g} Hz; shorten the step or leave the line out"
            )
    filter_Ad, filter_Bd = _sampled_filter(disturbance, step_s)
    n, turning = filter_Ad.shape[0], 2 * len(disturbance.lines)
    Ad, initial = np.zeros((turning + n, turning + n)), np.zeros((turning + n, turning + n))
    for i, line in enumerate(disturbance.lines):
        angle = 2.0 * math.pi * line.freq_hz * step_s
        cos, sin = math.cos(angle), math.sin(angle)
        Ad[2 * i : 2 * i + 2, 2 * i : 2 * i + 2] = [[cos, sin], [-sin, cos]]
    Ad[turning:, turning:] = filter_Ad
    initial[turning:, turning:] = lti.covariance_root(lti.gramian(filter_Ad.T, filter_Bd @ filter_Bd.T))
    return Discrete(
        Ad,
        np.vstack([np.zeros((turning, filter_Bd.shape[1])), filter_Bd]),
        np.hstack([np.tile([[1.0, 0.0]], (1, turning // 2)), disturbance.C]),
        initial,
        np.array([line.amplitude_rad for line in disturbance.lines]),
    )


def _sampled_filter(disturbance: Disturbance, step_s: float) -> tuple[Floats, Floats]:
    """Ad and Bd of the shaping filter alone, Bd with the fewest columns that keep the output."""
    from scipy.linalg import expm

    A, B, C = disturbance.A, disturbance.B, disturbance.C
    if A.size == 0:
        return np.zeros((0, 0)), np.zeros((0, 0))
    Ad = np.asarray(expm(A * step_s))
    seen = lti.gramian(Ad, C.T @ C)  # what a unit of noise on each state adds to the output's variance
    columns = [np.zeros((A.shape[0], 0))]
    for b in B.T[:, :, None]:
        root = lti.covariance_root(_noise_covariance(A, b, step_s))
        parts, directions = lti.principal_axes(root.T @ seen @ root)
        kept = parts > _DROPPED * np.sum(parts)
        variance = float((C @ covariance(A, b) @ C.T).item())
        if variance > 0.0:
            columns.append(root @ directions[:, kept] * math.sqrt(variance / np.sum(parts[kept])))
    return Ad, np.hstack(columns)


def _noise_covariance(A: Floats, b: Floats, step_s: float) -> Floats:
    """Integral of exp(A s) b b' exp(A' s) over a step: Van Loan's exponential over a short time, then doubled.

    Doubled because the exponential also holds exp(-A s), which overflows where a pole is fast against the step.
    """
    from scipy.linalg import expm

    n = A.shape[0]
    doublings = max(0, math.ceil(math.log2(float(np.linalg.norm(A, 1)) * step_s)))
    short = step_s / 2.0**doublings
    block = expm(np.block([[-A, b @ b.T], [np.zeros((n, n)), A.T]]) * short)
    over = block[n:, n:].T
    result = over @ block[:n, n:]
    for _ in range(doublings):
        result = result + over @ result @ over.T
        over = over @ over
    return np.asarray(0.5 * (result + result.T))


def initial_state(discrete: Discrete, gaussians: Floats, phases: Floats) -> Floats:
    """A stationary start of the states, shape as ``gaussians``.

    Args:
        discrete: The disturbance.
        gaussians: Independent standard normal numbers, shape (states,) or (states, runs).
        phases: Phases of the lines (rad), uniform over 0 to 2 pi, shape (lines,) or (lines, runs); more rows are not
            used.

    Raises:
        ValueError: For another number of rows than states, and for too few phases.
    """
    states, lines = discrete.Ad.shape[0], discrete.line_amplitude_rad.size
    if gaussians.shape[0] != states or phases.shape[0] < lines:
        raise ValueError(
            f"a start of {states} states with {lines} lines needs {states} rows of normal numbers and {lines} phases, "
            f"not {gaussians.shape[0]} and {phases.shape[0]}"
        )
    start = discrete.initial @ gaussians
    for i, amplitude in enumerate(discrete.line_amplitude_rad):
        start[2 * i], start[2 * i + 1] = amplitude * np.sin(phases[i]), amplitude * np.cos(phases[i])
    return np.asarray(start)
