"""What a linear loop does: closed loop, stability, stationary variances, and what its margins are."""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from microrad.core import lti
from microrad.core.arrays import Complexes, Floats
from microrad.loop.control.problem import GAUGE, OPTICAL, AxisController, DesignPlant

Flags = NDArray[np.bool_]
Response = Callable[[Floats], Complexes]
Distance = Callable[[Complexes], Floats]

COMMAND = 3
"""Output of a closed loop behind those of the plant (residual, optical, gauge): the command (V)."""

BREAKS = ("command", "optical")
"""Where a loop is cut: at the command all paths at once, at the optical sensor with the gauge's loop closed."""

_POINTS = 1000

SAME_POLE = 1e-3
"""Poles that are nearer to each other, over their half width, have the same frequencies around them."""

NEAR_LEAST = 1.3
"""Dips within this factor of the deepest point of a grid may be deeper than it between the points."""


# ------------------------------------------------------------------------------------------------ closed loop


def refuse_misfit(plant: DesignPlant, controller: AxisController, period_s: float | None = None) -> None:
    """Raise ValueError where a controller cannot close this plant's loop.

    Args:
        plant: The plant of one axis.
        controller: The controller of one axis that is to close its loop.
        period_s: Control period that the controller is made for, where it is known.

    Raises:
        ValueError: Wrong numbers of inputs, outputs or states, a number that is not finite, a plant that answers the
            command of its own sample, or a controller made for another control period.
    """
    s, name = controller.system, controller.name
    n = s.order
    shapes = {"A": (n, n), "B": (n, 2), "C": (1, n), "D": (1, 2)}
    found = {key: getattr(s, key) for key in shapes} | {"anti-windup": controller.anti_windup}
    for key, shape in (shapes | {"anti-windup": (n, 1)}).items():
        if found[key].shape != shape:
            raise ValueError(
                f"controller {name!r}: {key} has shape {found[key].shape}, not {shape}: a controller of one axis has "
                "the inputs optical and gauge, one output, and one row and column for a state"
            )
        if not np.isfinite(found[key]).all():
            raise ValueError(
                f"controller {name!r}: {key} holds a number that is not finite; look for a gain that is nan or infinite"
            )
    if plant.system.D[:, 0].any():
        raise ValueError("the plant answers the command of its own sample: give it its delay before a loop is closed")
    if period_s is not None and not math.isclose(period_s, plant.period_s, rel_tol=1e-9):
        raise ValueError(
            f"controller {name!r} is made for a period of {period_s:g} s, the plant is sampled every "
            f"{plant.period_s:g} s: design it again for this rate"
        )


def close(plant: DesignPlant, controller: AxisController) -> lti.StateSpace:
    """Close the loop: from the plant's white sequences to residual, optical, gauge (rad) and command (V), discrete.

    States: plant, controller. The command is not clipped. An unstable loop is returned as it is.

    Args:
        plant: The plant of one axis.
        controller: Its controller.

    Raises:
        ValueError: The controller does not fit, see `refuse_misfit`.
    """
    refuse_misfit(plant, controller)
    p, c = plant.system, controller.system
    command, white = p.B[:, :1], p.B[:, 1:]
    seen, noise = p.C[OPTICAL:], p.D[OPTICAL:, 1:]
    A = np.block([[p.A + command @ c.D @ seen, command @ c.C], [c.B @ seen, c.A]])
    B = np.vstack([white + command @ c.D @ noise, c.B @ noise])
    C = np.block([[p.C, np.zeros((3, c.order))], [c.D @ seen, c.C]])
    return lti.StateSpace(A, B, C, np.vstack([p.D[:, 1:], c.D @ noise]))


def reachable(A: Floats, B: Floats) -> Flags:
    """Which states an input reaches through the entries other than 0 of A and B: flags, shape (states,).

    For a plant built from blocks these are the states that a command moves; the rest is the disturbance's own.

    Args:
        A: Map of the states, shape (states, states).
        B: What the inputs add to the states, shape (states, inputs).
    """
    reached = np.any(B != 0.0, axis=1)
    for _ in range(A.shape[0]):
        reached = reached | np.any((A != 0.0) & reached, axis=1)
    return np.asarray(reached)


def moved(plant: DesignPlant) -> DesignPlant:
    """The plant without the states that its command does not reach, and without disturbance and noise."""
    s = plant.system
    r = reachable(s.A, s.B[:, :1])
    part = lti.StateSpace(s.A[np.ix_(r, r)], s.B[r][:, :1], s.C[:, r], s.D[:, :1])
    return DesignPlant(plant.period_s, part, 0, plant.gain_rad_v, plant.has_optical, plant.has_gauge)


def loop_poles(plant: DesignPlant, controller: AxisController) -> Complexes:
    """Poles z of the closed loop, largest first, without those that belong to the disturbance alone.

    Args:
        plant: The plant of one axis.
        controller: Its controller.

    Raises:
        ValueError: The controller does not fit, see `refuse_misfit`.
    """
    found = np.linalg.eigvals(close(moved(plant), controller).A)
    return np.asarray(found[np.argsort(-np.abs(found), kind="stable")], dtype=complex)


def refuse_unstable(plant: DesignPlant, controller: AxisController) -> None:
    """Raise ValueError where the closed loop is unstable.

    Args:
        plant: The plant of one axis.
        controller: Its controller.

    Raises:
        ValueError: The loop is unstable, with its worst pole and by how far it misses a margin; or the controller does
            not fit.
    """
    worst = loop_poles(plant, controller)[0]
    if abs(worst) < 1.0:
        return
    response, f = _respond(plant, controller, "command"), _resolving(plant, controller)
    least, _ = _least(_modulus, response, f, response(f))
    raise ValueError(
        f"controller {controller.name!r} makes the loop unstable: a pole at |z| = {abs(worst):.6f} (the limit is 1), "
        f"{abs(np.angle(worst)) / (2 * math.pi * plant.period_s):.4g} Hz, at a control period of {plant.period_s:g} s. "
        f"Its loop gain passes -1 on the wrong side, with a modulus min |1 + L| of {least:.3g}; "
        "lower its gains, shorten the delay, or tune it for a modulus margin"
    )


# ------------------------------------------------------------------------------------------------ variances


def h2(closed: lti.StateSpace) -> Floats:
    """Stationary variance of each output (row) that each white sequence of unit variance (column) causes.

    The sequences are independent: an output's variance is the sum of its row.

    Raises:
        ValueError: A pole lies on or outside the unit circle, so that there is no stationary variance.
    """
    worst = float(np.max(np.abs(np.linalg.eigvals(closed.A)), initial=0.0))
    if worst >= 1.0:
        raise ValueError(
            f"no stationary variance: a pole at |z| = {worst:.9f} (the limit is 1); give the disturbance some damping "
            "where it is the disturbance's own, else lower the controller's gains"
        )
    X = lti.gramian(closed.A, closed.C[:, :, None] * closed.C[:, None, :])
    return np.asarray(np.einsum("ij,oik,kj->oj", closed.B, X, closed.B) + closed.D**2)


def by_source(plant: DesignPlant, controller: AxisController, output: int = 0) -> dict[str, float]:
    """Variance of one output of the closed loop, by what causes it: disturbance, optical noise and gauge noise.

    Args:
        plant: The plant of one axis.
        controller: Its controller.
        output: Which output: the residual by default, `OPTICAL` or `GAUGE` (rad^2), or `COMMAND` (V^2).

    Raises:
        ValueError: The controller does not fit, or there is no stationary variance, see `h2`.
    """
    row = h2(close(plant, controller))[output]
    n = plant.disturbances
    parts = (row[:n], row[n : n + 1], row[n + 1 :])
    return dict(zip(("disturbance", "optical noise", "gauge noise"), (float(np.sum(p)) for p in parts), strict=True))


# ------------------------------------------------------------------------------------------------ margins


@dataclass(frozen=True, slots=True)
class DiskMargin:
    """A symmetric disk margin: 2 / max |S - T|, over changes of all loops at once where there are several.

    Source: Seiler, Packard and Gahinet, An introduction to disk margins, IEEE Control Systems Magazine 40 (2020) 78.
    """

    disk: float

    @property
    def disk_gain(self) -> tuple[float, float]:
        """Lowest and highest factor on the gain within the disk: (1 - disk/2) / (1 + disk/2) and its reciprocal."""
        lowest = max(0.0, (2.0 - self.disk) / (2.0 + self.disk)) if math.isfinite(self.disk) else 0.0
        return lowest, 1.0 / lowest if lowest else math.inf

    @property
    def disk_phase_rad(self) -> float:
        """Change of the phase, in either direction, within the disk: 2 atan(disk / 2)."""
        return 2.0 * math.atan(self.disk / 2.0)


@dataclass(frozen=True, slots=True)
class LoopMargins(DiskMargin):
    """Margins of one stable loop, and how far it reaches.

    ``gain_up`` and ``gain_down`` are the factors nearest 1 that make it unstable (infinite and 0 without one),
    ``phase_rad`` the smallest phase margin in either direction, ``delay_s`` the smallest additional delay, ``modulus``
    is min |1 + L|. ``crossover_hz`` is the highest frequency with |L| = 1 (nan without one), ``bandwidth_hz`` the
    lowest with |S| = 1, ``peak`` the largest |S|, at ``peak_hz``.
    """

    gain_up: float
    gain_down: float
    phase_rad: float
    delay_s: float
    modulus: float
    crossover_hz: float
    bandwidth_hz: float
    peak: float
    peak_hz: float


def loop_response(
    plant: DesignPlant, controller: AxisController, freq_hz: Floats, broken_at: str = "command"
) -> Complexes:
    """Loop gain L of the loop cut at one place, shape (frequencies,); 1 + L = 0 is the limit of stability.

    Args:
        plant: The plant of one axis.
        controller: Its controller.
        freq_hz: Frequencies in Hz up to half the control rate, one or an array of shape (frequencies,).
        broken_at: Where the loop is cut, one of `BREAKS`.

    Raises:
        ValueError: For a frequency above half the control rate, and where the controller does not fit.
    """
    refuse_misfit(plant, controller)
    freq_hz = np.atleast_1d(np.asarray(freq_hz, dtype=float))
    if np.any(freq_hz > 0.5 / plant.period_s * (1 + 1e-12)):
        raise ValueError(
            f"{np.max(freq_hz):g} Hz lies above half the control rate, {0.5 / plant.period_s:g} Hz: a sampled loop "
            "has no response of its own there"
        )
    return _respond(plant, controller, broken_at)(freq_hz)


def cut(K: Complexes, G: Complexes, broken_at: str) -> Complexes:
    """Loop gain, shape (...,), from the responses of controller and plant.

    At the command -(K_o G_o + K_g G_g); at the optical sensor, with the gauge's loop closed, -K_o G_o / (1 - K_g G_g).

    Args:
        K: From the optical sensor and the gauge (rad) to the command (V), shape (..., 2).
        G: From the command (V) to optical sensor and gauge (rad), shape (..., 2).
        broken_at: Where the loop is cut, one of `BREAKS`.
    """
    parts = K * G
    if broken_at == "command":
        return np.asarray(-parts[..., 0] - parts[..., 1])
    return np.asarray(-parts[..., 0] / (1.0 - parts[..., 1]))


def _respond(plant: DesignPlant, controller: AxisController, broken_at: str) -> Response:
    mirror = moved(plant).from_command

    def response(freq_hz: Floats) -> Complexes:
        parts = _parts(mirror, controller, freq_hz, plant.period_s)
        return real_at_half_the_rate(cut(*parts, broken_at), freq_hz * plant.period_s)

    return response


def _parts(
    mirror: lti.StateSpace, controller: AxisController, freq_hz: Floats, period_s: float
) -> tuple[Complexes, Complexes]:
    """Responses of controller (sensor to command) and plant (command to sensor), as `cut` takes them."""
    K = lti.frequency_response(controller.system, freq_hz, period_s)[:, 0, :]
    return K, lti.frequency_response(mirror, freq_hz, period_s)[:, :, 0]


def real_at_half_the_rate(L: Complexes, cycles: Floats) -> Complexes:
    """The loop gain without the imaginary part that rounding leaves at half the rate, where it is real.

    Args:
        L: Loop gain, shape (frequencies,).
        cycles: Its frequencies in cycles a sample, up to 0.5, shape (frequencies,).
    """
    return np.where(cycles > 0.5 - 1e-9, L.real, L)


def around_poles(poles: Complexes, period_s: float, ratio: float) -> Floats:
    """Frequencies (Hz) around discrete poles: from a fifth of the half width away, then each a constant factor farther.

    Poles that are the same but for rounding, as those of axes that are alike, count once: between their frequencies no
    parabola has digits.

    Args:
        poles: Poles z of a discrete system; those on the positive real axis have no resonance and are passed over.
        period_s: Control period, s.
        ratio: Factor, above 1, between the distances of neighbouring frequencies from their pole.
    """
    s = np.log(poles[np.abs(poles) > 1e-3].astype(complex)) / (2 * math.pi * period_s)
    found = []
    s = s[s.imag > 0.0]
    s = s[np.argsort(s.imag)]
    for k, pole in enumerate(s):
        centre, width = pole.imag, max(abs(pole.real), 1e-6 * pole.imag)
        if np.any(np.abs(s[:k] - pole) < SAME_POLE * width):
            continue
        reach = math.log(max(5.0 * centre / width, 2.0))
        away = 0.2 * width * np.exp(np.linspace(0.0, reach, math.ceil(reach / math.log(ratio)) + 1))
        found += [centre - away, [centre], centre + away]
    near = np.unique(np.concatenate([[], *found]))
    return near[(near > 0.0) & (near < 0.5 / period_s)]


def resolving(poles: Complexes, period_s: float) -> Floats:
    """Frequencies (Hz), rising to half the rate, on which a loop shows every resonance.

    Args:
        poles: Poles z of the loop, open and closed, shape (poles,).
        period_s: Control period, s.
    """
    near = around_poles(poles, period_s, 1.3) * (1.0 + 1e-9)  # an undamped filter has no response at its own
    return np.unique(np.concatenate([np.geomspace(1e-7, 0.5, _POINTS) / period_s, near]).clip(max=0.5 / period_s))


def _resolving(plant: DesignPlant, controller: AxisController) -> Floats:
    open_loop = (np.linalg.eigvals(s.A) for s in (moved(plant).system, controller.system))
    return resolving(np.concatenate([loop_poles(plant, controller), *open_loop]), plant.period_s)


def margins_at(plant: DesignPlant, controller: AxisController, broken_at: str = "command") -> LoopMargins:
    """Margins of the loop cut at one place.

    Args:
        plant: The plant of one axis.
        controller: Its controller.
        broken_at: Where the loop is cut, one of `BREAKS`.

    Raises:
        ValueError: The controller does not fit, or the loop is unstable.
    """
    refuse_misfit(plant, controller)
    refuse_unstable(plant, controller)
    return margins_of(_respond(plant, controller, broken_at), _resolving(plant, controller))


def margins_of(response: Response, freq_hz: Floats, known: Complexes | None = None) -> LoopMargins:
    """Margins of a stable loop.

    Each crossing and each dip is followed between the frequencies to where it is, so that the margins do not depend on
    which frequencies these are, as long as they resolve the loop.

    Args:
        response: Gives the loop gain L at frequencies in Hz; 1 + L = 0 is the limit of stability.
        freq_hz: Where the crossings and dips are looked for, Hz, rising, shape (frequencies,); see `resolving`.
        known: The response at these frequencies, of the same shape, where it is at hand.
    """
    L = response(freq_hz) if known is None else known
    size = np.abs(L)
    crossing = _roots(lambda f: np.log(np.abs(response(f))), freq_hz, np.log(np.maximum(size, 1e-300)))
    lag = np.mod(np.angle(-response(crossing)), 2 * math.pi)  # what would bring L to -1
    up, down = _gain_margins(response, freq_hz, L)
    modulus, where = _least(_modulus, response, freq_hz, L)
    return LoopMargins(
        gain_up=up,
        gain_down=down,
        phase_rad=float(np.min(np.minimum(lag, 2 * math.pi - lag), initial=math.inf)),
        delay_s=float(np.min(lag / (2 * math.pi * crossing), initial=math.inf)),
        modulus=modulus,
        disk=2.0 * _least(_balanced, response, freq_hz, L)[0],
        crossover_hz=float(np.max(crossing)) if crossing.size else math.nan,
        bandwidth_hz=_bandwidth_hz(response, freq_hz, L),
        peak=1.0 / modulus,
        peak_hz=where,
    )


def _gain_margins(response: Response, freq_hz: Floats, L: Complexes) -> tuple[float, float]:
    """Factors nearest 1, above and below, that bring the loop to -1: where it crosses the negative real axis."""
    crossing = response(_roots(lambda f: response(f).imag, freq_hz, L.imag)).real
    ends = L[[0, -1]]  # a positive feedback is limited at rest, and L is real at half the rate
    size = -np.append(crossing, ends.real[np.abs(ends.imag) < 1e-3 * np.abs(ends.real)])
    size = size[size > 0.0]
    return float(np.min(1.0 / size[size < 1.0], initial=math.inf)), float(np.max(1.0 / size[size > 1.0], initial=0.0))


def _bandwidth_hz(response: Response, freq_hz: Floats, L: Complexes) -> float:
    """Lowest frequency at which |S| = 1 / |1 + L| reaches 1 from below; 0 where it never lies below."""
    beyond = np.log(_modulus(L))
    if beyond[0] <= 0.0:
        return 0.0
    ends = slice(0, 1 + int(np.argmax(beyond <= 0.0)))
    found = _roots(lambda f: np.log(_modulus(response(f))), freq_hz[ends], beyond[ends])
    return float(found[0]) if found.size else float(freq_hz[-1])


def _roots(of: Callable[[Floats], Floats], freq_hz: Floats, values: Floats) -> Floats:
    """Where a function of frequency changes its sign; ``values`` are its own at ``freq_hz``."""
    from scipy.optimize import elementwise

    at = np.flatnonzero((values[:-1] >= 0.0) != (values[1:] >= 0.0))
    ends = freq_hz[at], freq_hz[at + 1]
    return np.asarray(elementwise.find_root(of, ends).x if at.size else ends[0])


def loop_margins(plant: DesignPlant, controller: AxisController) -> LoopMargins:
    """Worst margins over the places where the loop can be cut.

    Crossover, bandwidth and peak are those of the disturbance's rejection, 1 / (1 + L) of the loop cut at the optical
    sensor, or at the command where there is but one sensor.

    Args:
        plant: The plant of one axis.
        controller: Its controller.

    Raises:
        ValueError: The controller does not fit, or the loop is unstable.
    """
    if not uses_both(controller):
        return margins_at(plant, controller)
    whole, optical = margins_of_cuts(plant, controller)
    least = ("gain_up", "phase_rad", "delay_s", "modulus", "disk")
    return replace(
        optical,
        gain_down=max(whole.gain_down, optical.gain_down),
        **{name: min(getattr(whole, name), getattr(optical, name)) for name in least},
    )


def margins_of_cuts(plant: DesignPlant, controller: AxisController) -> tuple[LoopMargins, LoopMargins]:
    """Margins of the loop cut at each of `BREAKS`, in their order; faster than `margins_at` one after the other.

    Args:
        plant: The plant of one axis.
        controller: Its controller.

    Raises:
        ValueError: The controller does not fit, or the loop is unstable.
    """
    refuse_misfit(plant, controller)
    refuse_unstable(plant, controller)
    freq, period = _resolving(plant, controller), plant.period_s
    parts = _parts(moved(plant).from_command, controller, freq, period)

    def margins(broken_at: str) -> LoopMargins:
        L = real_at_half_the_rate(cut(*parts, broken_at), freq * period)
        return margins_of(_respond(plant, controller, broken_at), freq, L)

    command, optical = BREAKS
    return margins(command), margins(optical)


def uses_both(controller: AxisController) -> bool:
    """Whether a controller feeds back both the optical sensor and the gauge."""
    s = controller.system
    used = np.any(s.B != 0.0, axis=0) | np.any(s.D != 0.0, axis=0)
    return bool(np.all(used[[OPTICAL - 1, GAUGE - 1]]))


def bandwidth_hz(freq_hz: Floats, distance: Floats) -> float:
    """Lowest frequency at which the sensitivity |S| reaches 1 from below, between the points of a grid.

    It is 0 where |S| never lies below 1, and the last frequency of the grid where it always does.

    Args:
        freq_hz: Grid of frequencies, rising, shape (frequencies,).
        distance: Distance |1 + L| = 1 / |S| at each of them, shape (frequencies,).
    """
    if distance[0] <= 1.0:
        return 0.0
    at = int(np.argmax(distance <= 1.0))
    if distance[at] > 1.0:
        return float(freq_hz[-1])
    above, below = math.log(distance[at - 1]), math.log(distance[at])
    return float(freq_hz[at - 1] * (freq_hz[at] / freq_hz[at - 1]) ** (above / (above - below)))


def _modulus(L: Complexes) -> Floats:
    """|1 + L|."""
    return np.abs(1.0 + L)


def _balanced(L: Complexes) -> Floats:
    """1 / |S - T| = |1 + L| / |1 - L|, cut off where it is large."""
    return np.asarray(np.abs(1.0 + L) / np.maximum(np.abs(1.0 - L), 1e-9))


def _least(distance: Distance, response: Response, freq_hz: Floats, L: Complexes) -> tuple[float, float]:
    """Smallest distance and its frequency: each dip that may be the deepest one is followed to its end."""
    from scipy.optimize import elementwise

    found = distance(L)
    at = int(np.argmin(found))
    least = (float(found[at]), float(freq_hz[at]))
    dips = 1 + np.flatnonzero((found[1:-1] < found[:-2]) & (found[1:-1] <= found[2:]))
    dips = dips[found[dips] < NEAR_LEAST * least[0]]
    if not dips.size:
        return least
    ends = freq_hz[dips - 1], freq_hz[dips], freq_hz[dips + 1]
    ended = elementwise.find_minimum(lambda f: distance(response(f)), ends)
    best = int(np.argmin(ended.f_x))
    return min(least, (float(ended.f_x[best]), float(ended.x[best])))


@dataclass(frozen=True, slots=True)
class MultiloopMargin(DiskMargin):
    """Disk margin of two loops whose gain and phase change at once, each on its own, and where it is smallest."""

    freq_hz: float


def multiloop_disk_margin(freq_hz: Floats, L: Complexes) -> MultiloopMargin:
    """Disk margin of a two-axis loop against changes of both loops at once, each on its own.

    2 / max over the frequencies of min over real diagonal D of the largest singular value of D (S - T) D^-1, which for
    two loops is the structured singular value itself. Source: Seiler, Packard and Gahinet, IEEE Control Systems
    Magazine 40 (2020) 78.

    Scaling keeps the determinant, the product of both singular values, so the larger one is smallest where the sum of
    squares is: where both entries off the diagonal have the same size.

    Args:
        freq_hz: Frequencies, shape (frequencies,).
        L: Loop gain at each of them, shape (frequencies, 2, 2).

    Raises:
        ValueError: For a loop gain of another shape.
    """
    if L.shape != (freq_hz.size, 2, 2):
        raise ValueError(
            f"a loop gain of shape {L.shape} is not two loops at {freq_hz.size} frequencies: give two axes"
        )
    M = 2.0 * np.linalg.inv(np.eye(2) + L) - np.eye(2)
    squares = np.abs(M[:, 0, 0]) ** 2 + np.abs(M[:, 1, 1]) ** 2 + 2.0 * np.abs(M[:, 0, 1] * M[:, 1, 0])
    product = np.abs(np.linalg.det(M)) ** 2
    largest = np.sqrt(0.5 * (squares + np.sqrt(np.maximum(squares**2 - 4.0 * product, 0.0))))
    at = int(np.argmax(largest))
    return MultiloopMargin(2.0 / float(largest[at]), float(freq_hz[at]))
