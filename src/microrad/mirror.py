"""The fast steering mirror: one plant form for every mirror, a linear system with a bank of hysteresis operators.

    x' = A x + B u + E z        q = F x + G u        z = H[q, q']        y = C x + D u + K z

Drive u in volts at the amplifier's input, output y in radians. All are deviations from rest at the bias voltage.
"""

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from microrad import kernels, lti, mission

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class BoucWen:
    """Parameters of Eq. 3 of SPIE 11852, 118523B, in radians, volts and seconds.

    y = d1 exp(-d2 q') q + h,  h' = epsilon exp(delta |q'|) q' - beta q' |h| - alpha |q'| h.
    Beyond ``rate_limit_v_s`` the exponents are held and each such sample is counted; ``bias_v`` is the resting drive.
    """

    d1_rad_v: float
    d2_s_v: float
    epsilon_rad_v: float
    delta_s_v: float
    alpha_1_v: float
    beta_1_v: float
    rate_limit_v_s: float = math.inf
    bias_v: float = 0.0

    @property
    def row(self) -> tuple[float, ...]:
        """The parameters in the order of the kernel's columns."""
        return (
            self.d1_rad_v,
            self.d2_s_v,
            self.epsilon_rad_v,
            self.delta_s_v,
            self.alpha_1_v,
            self.beta_1_v,
            self.rate_limit_v_s,
            self.bias_v,
        )

    @property
    def settled_rad(self) -> float:
        """Magnitude at which |h| settles on a slow, long ramp: |epsilon| / (alpha + beta sign(epsilon))."""
        return abs(self.epsilon_rad_v) / (self.alpha_1_v + math.copysign(1.0, self.epsilon_rad_v) * self.beta_1_v)

    def reversal_slope_rad_v(self, rate_v_s: float = 0.0) -> float:
        """Local slope dy/du just after a reversal from a settled branch at ``rate_v_s``; not physical below 0.

        A settled branch has epsilon e = k h; behind the reversal the drive term keeps its slope and the decay changes
        side: dh/du = 2 alpha epsilon e / (alpha + beta sign(epsilon)), with e = exp(delta |rate|).
        """
        growth = math.exp(self.delta_s_v * min(abs(rate_v_s), self.rate_limit_v_s))
        side = self.alpha_1_v + math.copysign(1.0, self.epsilon_rad_v) * self.beta_1_v
        return self.d1_rad_v + 2.0 * self.alpha_1_v * self.epsilon_rad_v * growth / side

    @property
    def admissible_rate_v_s(self) -> float:
        """Fastest rate at which the slope after a reversal is not negative; 0 if there is none, inf if it never is."""
        swing = self.d1_rad_v - self.reversal_slope_rad_v()
        if swing <= 0.0:
            return math.inf
        if swing > self.d1_rad_v:
            return 0.0
        return math.inf if self.delta_s_v <= 0.0 else math.log(self.d1_rad_v / swing) / self.delta_s_v

    @property
    def wrong_way_rad(self) -> float:
        """How far the slow model moves the wrong way after a reversal (0 when admissible).

        With s the travel behind the reversal, h starts at its settled size against it: dh/ds = -e - k h down to 0, with
        e = |epsilon| and k = alpha + beta (epsilon < 0), then -e + k' |h|, with k' = alpha - beta. The output turns
        where dh/ds = -d1.
        """
        if self.reversal_slope_rad_v() >= 0.0:
            return 0.0
        e, d1, h0 = -self.epsilon_rad_v, self.d1_rad_v, self.settled_rad
        k, beyond = self.alpha_1_v + self.beta_1_v, self.alpha_1_v - self.beta_1_v
        if e <= d1:
            travel = math.log((e + k * h0) / d1) / k
            return (h0 + e / k) * -math.expm1(-k * travel) - d1 * travel
        to_zero, after = math.log1p(k * h0 / e) / k, math.log(e / d1) / beyond
        return h0 - d1 * to_zero + e * -math.expm1(-beyond * after) / beyond - d1 * after


@dataclass(frozen=True, slots=True)
class Play:
    """Play (backlash) operators of a Prandtl-Ishlinskii model: z = sum of weight x play(threshold)."""

    thresholds_v: tuple[float, ...]
    weights_rad_v: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class Mirror:
    """A mirror in the plant form of this module, continuous in time, with its arrays named as there.

    Bouc-Wen elements come first in the rows of F and G and the columns of E and K, play operators after them.
    ``inverse`` names, by actuator, the hysteresis that a feedforward inverts.
    """

    name: str
    A: Floats
    B: Floats
    E: Floats
    F: Floats
    G: Floats
    C: Floats
    D: Floats
    K: Floats
    bouc_wen: tuple[BoucWen, ...]
    play: Play
    inverse: tuple[BoucWen | Play, ...]

    @property
    def actuators(self) -> int:
        """Number of drives."""
        return int(self.B.shape[1])

    @property
    def axes(self) -> int:
        """Number of outputs."""
        return int(self.C.shape[0])

    @property
    def linear_loop(self) -> lti.StateSpace:
        """The mirror with each element replaced by its slow gain, for margins (Bouc-Wen: d1, play: weight)."""
        slopes = np.array([b.d1_rad_v for b in self.bouc_wen] + list(self.play.weights_rad_v))
        through = slopes[:, None]
        return lti.StateSpace(
            self.A + self.E @ (through * self.F),
            self.B + self.E @ (through * self.G),
            self.C + self.K @ (through * self.F),
            self.D + self.K @ (through * self.G),
        )


def linear_part(table: mission.LinearPart) -> tuple[lti.StateSpace, float]:
    """Linear part divided by its gain at the normalising frequency, and that gain: magnitude, with the sign of Re.

    The gain of the mirror belongs to its hysteresis model; cascading two models with a gain each squares it.
    """
    system = lti.modal_from_polynomials(table.numerator, table.denominator)
    response = complex(lti.frequency_response(system, np.array([table.normalise_at_hz]))[0, 0, 0])
    gain = math.copysign(abs(response), response.real)
    return replace(system, C=system.C / gain), gain


def hysteresis_model(
    table: mission.Mirror | mission.Comparison, rate_limit_v_s: float, bias_v: float
) -> BoucWen | Play:
    """The hysteresis model of a mirror table, as this module's record."""
    if table.bouc_wen is not None:
        b = table.bouc_wen
        return BoucWen(
            b.d1_rad_v, b.d2_s_v, b.epsilon_rad_v, b.delta_s_v, b.alpha_1_v, b.beta_1_v, rate_limit_v_s, bias_v
        )
    assert table.prandtl_ishlinskii is not None  # the mission's own check
    return Play(table.prandtl_ishlinskii.thresholds_v, table.prandtl_ishlinskii.weights_rad_v)


LINE_OF_SIGHT = {"line-of-sight": 1.0, "mechanical": 2.0}
"""Angle of the line of sight by the convention of a mirror's output: reflection doubles a tilt, per axis."""


def line_of_sight(model: BoucWen | Play, convention: str) -> BoucWen | Play:
    """The model with its output as an angle of the line of sight.

    "mechanical" is doubled (reflection, per axis at normal incidence); "line-of-sight" is as it stands.
    """
    times = LINE_OF_SIGHT[convention]
    if isinstance(model, Play):
        return replace(model, weights_rad_v=tuple(times * w for w in model.weights_rad_v))
    return replace(model, d1_rad_v=times * model.d1_rad_v, epsilon_rad_v=times * model.epsilon_rad_v)


def from_mission(table: mission.Mirror, model: BoucWen | Play, composition: str | None = None) -> Mirror:
    """Assemble one axis of the mission's linear part and a hysteresis model, in the mission's composition or another.

    cascade: the hysteresis drives the linear part (q = u, B = 0). additive: the linear gain drives the linear part and
    the hysteresis is added behind it through K. static: no linear part.
    """
    system = None if table.linear is None else linear_part(table.linear)[0]
    return assemble(table.name, composition or table.composition, system, model)


def assemble(name: str, composition: str, system: lti.StateSpace | None, model: BoucWen | Play) -> Mirror:
    """One axis from a linear part of unit gain (none for "static") and a hysteresis model.

    Raises ValueError for a composition that lacks its linear part.
    """
    if composition != "static" and system is None:
        raise ValueError(f'composition "{composition}" needs a linear part; give one or choose "static"')
    if system is None or composition == "static":
        system = lti.StateSpace(np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), np.zeros((1, 1)))
    bouc_wen, play = _elements(model, split=composition == "additive")
    through_linear, direct = _routes(composition, len(bouc_wen) + len(play.thresholds_v))
    n, elements = system.order, through_linear.size
    return Mirror(
        name=name,
        A=system.A,
        B=np.zeros((n, 1)),
        E=system.B @ through_linear[None, :],
        F=np.zeros((elements, n)),
        G=np.ones((elements, 1)),
        C=system.C,
        D=np.zeros((1, 1)),
        K=direct[None, :],
        bouc_wen=bouc_wen,
        play=play,
        inverse=(model,),
    )


def slow_gain(model: BoucWen | Play) -> float:
    """Gain for slow, large drives (rad/V): d1, or the sum of the weights."""
    return model.d1_rad_v if isinstance(model, BoucWen) else math.fsum(model.weights_rad_v)


def output_amplitude(model: BoucWen | Play, drive_v: float) -> float:
    """Amplitude of the settled output (rad) under a slow drive of amplitude ``drive_v``, Bouc-Wen's h left out."""
    if isinstance(model, BoucWen):
        return model.d1_rad_v * drive_v
    pairs = zip(model.thresholds_v, model.weights_rad_v, strict=True)
    return math.fsum(w * max(0.0, drive_v - r) for r, w in pairs)


def secant_gain(model: BoucWen | Play, output_rad: float) -> float:
    """Output amplitude over the drive amplitude that gives it (rad/V), for slow sines of amplitude ``output_rad``.

    A Prandtl-Ishlinskii model is softer for small drives; without amplitude (inf) this is its slow gain.
    """
    if isinstance(model, BoucWen) or math.isinf(output_rad):
        return slow_gain(model)
    knots = [output_amplitude(model, r) for r in model.thresholds_v]
    slopes = np.cumsum(model.weights_rad_v)
    last = max(i for i, y in enumerate(knots) if y <= output_rad)
    if slopes[last] <= 0.0:
        return slow_gain(model)
    return output_rad / (model.thresholds_v[last] + (output_rad - knots[last]) / float(slopes[last]))


def _elements(model: BoucWen | Play, split: bool) -> tuple[tuple[BoucWen, ...], Play]:
    """Bank of one model; split into its linear gain first and its hysteresis after it."""
    if isinstance(model, Play):
        return (), model
    if not split:
        return (model,), Play((), ())
    return (replace(model, epsilon_rad_v=0.0), replace(model, d1_rad_v=0.0)), Play((), ())


def _routes(composition: str, elements: int) -> tuple[Floats, Floats]:
    """Which elements drive the linear part, and which are added to the output."""
    ones, first = np.ones(elements), np.eye(elements)[0]
    if composition == "cascade":
        return ones, 0.0 * ones
    return (first, ones - first) if composition == "additive" else (0.0 * ones, ones)


def gain_only(model: BoucWen | Play, output_rad: float = math.inf) -> BoucWen:
    """The model without hysteresis: its secant gain at an output amplitude, or its slow gain, and nothing else."""
    return BoucWen(secant_gain(model, output_rad), 0.0, 0.0, 0.0, 0.0, 0.0)


def combine(*mirrors: Mirror) -> Mirror:
    """Independent mirrors side by side: the axes, actuators and elements of the first, then of the next."""
    from scipy.linalg import block_diag  # slow to import, not needed to show help

    bw = [len(m.bouc_wen) for m in mirrors]
    total = np.cumsum([0] + [len(m.bouc_wen) + len(m.play.thresholds_v) for m in mirrors])
    order = [int(t) + i for t, n in zip(total, bw, strict=False) for i in range(n)]
    order += [i for i in range(int(total[-1])) if i not in order]  # Bouc-Wen elements first
    blocks = {key: block_diag(*(getattr(m, key) for m in mirrors)) for key in "ABEFGCDK"}
    return Mirror(
        name=" + ".join(m.name for m in mirrors),
        A=blocks["A"],
        B=blocks["B"],
        E=blocks["E"][:, order],
        F=blocks["F"][order],
        G=blocks["G"][order],
        C=blocks["C"],
        D=blocks["D"],
        K=blocks["K"][:, order],
        bouc_wen=sum((m.bouc_wen for m in mirrors), ()),
        play=Play(
            sum((m.play.thresholds_v for m in mirrors), ()),
            sum((m.play.weights_rad_v for m in mirrors), ()),
        ),
        inverse=sum((m.inverse for m in mirrors), ()),
    )


def discretise(mirror: Mirror, step_s: float) -> kernels.Plant:
    """The mirror for a fixed step with u and z linear over it.

    Raises ValueError, naming a step that would do, when q = F x closes a loop through one step that is no contraction.
    """
    inputs = np.hstack([mirror.B, mirror.E])
    Ad, start, end = lti.first_order_hold(mirror.A, inputs, step_s)
    m = mirror.actuators
    if contraction(mirror, step_s) >= 1.0:
        usable = step_s
        while contraction(mirror, usable) >= 0.5:
            usable /= 2.0
        raise ValueError(
            f"mirror {mirror.name!r}: the loop through F is no contraction at a step of {step_s:g} s; "
            f"use a step of at most {usable:.3g} s, or move the mean slope of the hysteresis into A"
        )
    B0, E0, B1, E1 = start[:, :m], start[:, m:], end[:, :m], end[:, m:]
    return plant_arrays(step_s, (Ad, B0, B1, E0, E1), mirror)


def plant_arrays(step_s: float, discrete: tuple[Floats, ...], mirror: Mirror) -> kernels.Plant:
    """The kernel's arrays from the discrete matrices Ad, B0, B1, E0, E1 and the mirror's F, G, C, D, K and bank."""
    Ad, B0, B1, E0, E1 = discrete
    n, odd = Ad.shape[0], Ad.shape[0] % 2  # the kernel pairs the states: an odd one gets an idle partner
    Ad = np.pad(Ad, (0, odd))
    neighbour = np.arange(n + odd) ^ 1
    near = np.eye(n + odd, dtype=bool) | (np.arange(n + odd)[:, None] == neighbour)

    def count(size: int) -> kernels.Count:
        return (0,) * size

    def below(matrix: Floats) -> Floats:
        return np.pad(matrix.astype(float), ((0, odd), (0, 0)))

    def beside(matrix: Floats) -> Floats:
        return np.pad(matrix.astype(float), ((0, 0), (0, odd)))

    return kernels.Plant(
        step_s=float(step_s),
        states=count(n),
        actuators=count(mirror.actuators),
        outputs=count(mirror.axes),
        elements=count(len(mirror.bouc_wen)),
        feedback=bool(np.any(mirror.F)),
        direct=bool(np.any(mirror.B) or np.any(mirror.D)),
        diagonal=np.diag(Ad).copy(),
        coupling=Ad[np.arange(n + odd), neighbour],
        rest=kernels.rows(np.where(near, 0.0, Ad)),
        B0=below(B0),
        B1=below(B1),
        E_held=below(E0 + E1),
        E1=below(E1),
        F=beside(mirror.F),
        G=mirror.G.astype(float),
        C=beside(mirror.C),
        D=mirror.D.astype(float),
        CE1=mirror.C @ E1,
        K=mirror.K.astype(float),
        bouc_wen=np.array([b.row for b in mirror.bouc_wen], dtype=float).reshape(-1, 8),
        play_threshold=np.array(mirror.play.thresholds_v, dtype=float),
        play_weight=np.array(mirror.play.weights_rad_v, dtype=float),
    )


def contraction(mirror: Mirror, step_s: float) -> float:
    """Bound on how much of an error in z at the end of a step returns through F and the steepest slope of the bank."""
    if not np.any(mirror.F):
        return 0.0
    end = lti.first_order_hold(mirror.A, mirror.E, step_s)[2]
    steepest = [_steepest(b) for b in mirror.bouc_wen] + [abs(w) for w in mirror.play.weights_rad_v]
    return float(np.linalg.norm((mirror.F @ end) * np.array(steepest)[None, :], np.inf))


def _steepest(b: BoucWen) -> float:
    if math.isinf(b.rate_limit_v_s) and (b.delta_s_v or b.d2_s_v):
        raise ValueError("a Bouc-Wen element that is fed back and depends on rate needs a finite rate limit")
    rate = b.rate_limit_v_s if b.delta_s_v or b.d2_s_v else 0.0
    slope = (
        abs(b.epsilon_rad_v)
        * math.exp(b.delta_s_v * rate)
        * 2.0
        * b.alpha_1_v
        / max(b.alpha_1_v - abs(b.beta_1_v), 1e-12)
    )
    return abs(b.d1_rad_v) * math.exp(abs(b.d2_s_v) * rate) + abs(slope)


def at_rest(plant: kernels.Plant) -> kernels.PlantState:
    """A fresh state of the plant: everything zero, which is rest at the bias."""
    m, bouc_wen = len(plant.actuators), len(plant.elements)
    return kernels.PlantState(
        x=np.zeros(plant.diagonal.size),
        x_next=np.zeros(plant.diagonal.size),
        u=np.zeros(m),
        u_next=np.zeros(m),
        y=np.zeros(len(plant.outputs)),
        bank=np.zeros((bouc_wen + plant.play_threshold.size, 4)),
        clamped=np.zeros(bouc_wen, dtype=np.int64),
    )
