"""All axes at once: what controllers of several axes leave and how far they are from -1, and LQG tuned for both."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from microrad.core import lti
from microrad.core.arrays import Floats
from microrad.loop.control import DesignPlant, Weights, WholePlant, lqg_of_axes, rounded
from microrad.loop.control.judge import grid, quadrature

SPANS = {"command weight": (1e-8, 1e2), "sensor noise factor": (0.1, 30.0), "command noise": (1e-3, 10.0)}
"""Bounds of what LQG is tuned by; the command's noise over what the optical noise is worth in volts."""

COARSE, FINE = 1.0, 1.0 / 32.0
"""First and last step of the search, in decades of each weight."""

MOVES = np.array([move for move in product((-1.0, 0.0, 1.0), repeat=3) if any(move)])
"""Directions that the search looks in."""

PRICE = 20.0
"""What a missing modulus margin costs a candidate, over its residual: more than any weight gains by it."""


@dataclass(frozen=True, slots=True)
class Closed:
    """What a controller of all axes has on several plants: worst pole, mean variance (rad^2), least modulus."""

    pole: float
    mean_rad2: float
    modulus: float


class WholeJudge:
    """Residual and margin of any controller of all axes on some plants, from responses that are computed once."""

    def __init__(self, plants: Sequence[WholePlant]) -> None:
        """Compute the responses of the plants.

        Args:
            plants: Plants of the same axes and control period.
        """
        self.plants, self.axes, self._period = plants, plants[0].axes, plants[0].period_s
        self._freq = [grid(p.system, p.period_s) for p in plants]
        self._responses = [
            lti.frequency_response(p.system, f, p.period_s) for p, f in zip(plants, self._freq, strict=True)
        ]

    def __call__(self, system: lti.StateSpace) -> Closed:
        """Judge one controller, from optical errors to commands of the axes."""
        pole = max(spectral_radius(p, system) for p in self.plants)
        if not pole < 1.0 - 1e-9:
            return Closed(pole, math.inf, 0.0)
        variances, moduli = zip(*map(self._on, range(len(self.plants)), [system] * len(self.plants)), strict=True)
        return Closed(pole, float(np.mean(variances)), min(moduli))

    def _on(self, number: int, system: lti.StateSpace) -> tuple[float, float]:
        freq, whole, axes = self._freq[number], self._responses[number], self.axes
        rows = lti.resolvent_rows(system.A[None], system.C[None], np.exp(2j * math.pi * freq * self._period))[0]
        K = np.moveaxis(rows, 2, 0) @ system.B + system.D
        returned = np.eye(axes) - whole[:, axes:, :axes] @ K
        seen = np.linalg.solve(returned, whole[:, axes:, axes:])
        left = whole[:, :axes, axes:] + whole[:, :axes, :axes] @ (K @ seen)
        spectrum = np.sum(left.real**2 + left.imag**2, axis=(1, 2))
        modulus = float(np.min(np.linalg.svd(returned, compute_uv=False)[:, -1]))
        return 2.0 * self._period * float(quadrature(freq) @ spectrum), modulus


def spectral_radius(plant: WholePlant, system: lti.StateSpace) -> float:
    """Largest |z| of the loop of all axes; infinite where a number is not finite."""
    s, axes = plant.system, plant.axes
    command, seen = s.B[:, :axes], s.C[axes:]
    whole = np.block([[s.A + command @ system.D @ seen, command @ system.C], [system.B @ seen, system.A]])
    return float(np.max(np.abs(np.linalg.eigvals(whole)))) if np.isfinite(whole).all() else math.inf


def with_others_closed(plant: WholePlant, axis: int, others: Sequence[lti.StateSpace | None]) -> DesignPlant:
    """One axis as its controller sees it while those of the other axes work.

    Args:
        plant: The plant of all axes.
        axis: Number of the axis, from 0.
        others: By axis, the controller from its optical error to its command; None for one that does not work. That of
            the axis itself is not looked at.
    """
    s, axes = plant.system, plant.axes
    A, B, C, D = s.A, s.B, s.C, s.D
    for number, controller in enumerate(others):
        if controller is None or number == axis:
            continue
        k, seen = controller, axes + number
        command, extra = B[:, number : number + 1], np.zeros((C.shape[0], k.order))
        A, B = (
            np.block([[A + command @ k.D @ C[seen : seen + 1], command @ k.C], [k.B @ C[seen : seen + 1], k.A]]),
            np.vstack([B + command @ k.D @ D[seen : seen + 1], k.B @ D[seen : seen + 1]]),
        )
        C = np.hstack([C, extra])
    rows, white = [axis, axes + axis], list(range(axes, B.shape[1]))
    own = axes + plant.disturbances + axis  # this axis's optical noise stands last, before that of no gauge
    order = [axis, *(i for i in white if i != own), own]
    B, D = np.pad(B[:, order], ((0, 0), (0, 1))), np.pad(D[np.ix_(rows, order)], ((0, 1), (0, 1)))
    system = lti.StateSpace(A, B, np.vstack([C[rows], np.zeros((1, A.shape[0]))]), D)
    return DesignPlant(plant.period_s, system, len(order) - 2, plant.gain_rad_v, True, False)


def lqg_for(
    plants: Sequence[WholePlant], modulus: float, on_progress: Callable[[int], None] = lambda done: None
) -> tuple[lti.StateSpace, Floats, dict[str, float]]:
    """LQG of all axes with the least mean residual over the plants that keeps a modulus margin on all of them.

    It is built for the first plant. A compass search goes over a grid of its weights, ever finer, and ends on it: which
    of two neighbours is better does not hang on rounding. Returned are controller, anti-windup input and weights.

    Args:
        plants: The plant at rest, then others that it could also be.
        modulus: Least singular value of 1 + L that is asked for.
        on_progress: Called with the candidates that are judged.

    Raises:
        ValueError: No candidate keeps the margin; says what the best one reaches.
    """
    judge, own = WholeJudge(plants), plants[0]
    noise = float(np.sqrt(np.mean(np.sum(own.system.D[own.axes :, own.axes :] ** 2, axis=1))))
    unit = max(noise, 1e-12) / abs(own.gain_rad_v)
    units = np.array([1.0, 1.0, unit])
    low, high = np.log10(np.array(list(SPANS.values()))).T
    known: dict[tuple[float, ...], tuple[float, Closed]] = {}

    def weights(place: tuple[float, ...]) -> list[float]:
        return [rounded(float(v)) for v in 10.0 ** np.array(place) * units]

    def cost(place: tuple[float, ...]) -> float:
        if place not in known:
            try:
                found = judge(lqg_of_axes(own, Weights(*weights(place)))[0])
            except ValueError:
                found = Closed(math.inf, math.inf, 0.0)
            missing = max(0.0, modulus * 1.001 - found.modulus) / modulus
            value = math.log(found.mean_rad2) + PRICE * missing if found.pole < 1.0 else 1e3 + min(found.pole, 1e3)
            known[place] = value, found
            on_progress(len(known))
        return known[place][0]

    starts = [(a, b, c) for a in (-4.0, -2.0, 0.0) for b in (0.0, 1.0) for c in (-2.0, 0.0)]
    place, step = min(starts, key=cost), COARSE
    while step >= FINE:
        near = [tuple(np.clip(np.array(place) + step * move, low, high).tolist()) for move in MOVES]
        best = min(near, key=cost)
        if cost(best) < cost(place):
            place = best
        else:
            step /= 2.0
    reached = known[place][1]
    if reached.modulus < modulus:
        raise ValueError(
            f"no LQG of {len(known)} tried meets the specification: a modulus margin of {modulus:g} with all axes "
            f"closed is asked for, the nearest reaches {reached.modulus:.3g}; ask for less, or shorten the delay"
        )
    system, windup = lqg_of_axes(own, Weights(*weights(place)), coarse=True)
    return system, windup, dict(zip(SPANS, weights(place), strict=True))
