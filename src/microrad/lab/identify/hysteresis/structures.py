"""Structures for the joint fit: one axis of a mirror (hysteresis, linear part, creep), and a hysteretic oscillator."""

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import NamedTuple

import numpy as np

from microrad.core import lti
from microrad.core.arrays import Floats
from microrad.lab.identify.hysteresis.plant_fit import Parameter, Structure
from microrad.mirror import model as mirror
from microrad.mirror.hysteresis import NO_CREEP, BoucWen, Creep, PrandtlIshlinskii, slow_gain
from microrad.mirror.model import Mirror
from microrad.mission.tables.mirror import roots_from_damping

_RATIO = 0.999  # of alpha, at most: beyond it h would grow without bound
_STIFFEST = 30.0  # times the start of alpha: beyond it is a play that no sample sees bend, whose steps take ever longer
_DAMPING = (1e-4, 0.9999)
_ALLOWED = 4.0  # standard errors
_LONGEST = 10.0  # times its start, or the decay of the fastest pole: the longest delay that is searched


@dataclass(frozen=True, slots=True)
class Roots:
    """Poles or zeros as natural frequencies (Hz) and damping ratios; at 1 or more (-1 or less) one real root each."""

    frequencies_hz: tuple[float, ...]
    dampings: tuple[float, ...]

    @property
    def values(self) -> np.ndarray[tuple[int], np.dtype[np.complex128]]:
        """The roots in rad/s, conjugates included."""
        return np.array(roots_from_damping(self.frequencies_hz, self.dampings), dtype=complex)

    def without(self, *places: int) -> "Roots":
        """The others, counted from 0."""
        kept = [i for i in range(len(self.dampings)) if i not in places]
        return Roots(tuple(self.frequencies_hz[i] for i in kept), tuple(self.dampings[i] for i in kept))

    @classmethod
    def of(cls, roots: Iterable[complex]) -> "Roots":
        """Natural frequencies and dampings of roots in rad/s; of a conjugate pair one is looked at."""
        kept = [complex(r) for r in roots if complex(r).imag >= 0.0]
        kept.sort(key=abs)
        real = [abs(r.imag) <= 1e-12 * abs(r) for r in kept]
        dampings = [
            math.copysign(1.0, -r.real) if flat else -r.real / abs(r) for r, flat in zip(kept, real, strict=True)
        ]
        return cls(tuple(abs(r) / (2 * math.pi) for r in kept), tuple(dampings))


@dataclass(frozen=True, slots=True)
class LinearPoles:
    """A linear part of unit gain: poles, zeros, and the frequency (Hz) at which its magnitude is 1.

    `delay_s` is the pure delay of the recording chain, which is no part of `system`, and `delay_error_s` its standard
    error where a response has shown it.
    """

    poles: Roots
    zeros: Roots
    normalise_at_hz: float
    delay_s: float = 0.0
    delay_error_s: float = math.inf

    @property
    def system(self) -> lti.StateSpace:
        """The linear part in real modal form."""
        return lti.modal_from_roots(self.zeros.values, self.poles.values, self.normalise_at_hz)


def poles_of(system: lti.StateSpace, excited_hz: tuple[float, float], rate_hz: float) -> LinearPoles:
    """Poles and zeros of a strictly proper system with one input and output.

    It is normalised at the geometric middle between the lowest excited frequency and a tenth of the lowest resonance,
    where its gain should be flat. Zeros above the sample rate do nothing that it could show, and are left out; so are
    as many poles as zeros below the excited band, a flank fitted as dynamics that would only move the gain at rest.

    Args:
        system: The system.
        excited_hz: Lowest and highest excited frequency.
        rate_hz: Sample rate.
    """
    poles = [complex(p) for p in np.linalg.eigvals(system.A)]
    zeros = [complex(z) for z in lti.zeros(system) if abs(z) < 2.0 * math.pi * rate_hz]
    slow = 2.0 * math.pi * excited_hz[0]
    below = [sorted((r for r in roots if abs(r) < slow), key=abs) for roots in (poles, zeros)]
    if len(below[0]) == len(below[1]):
        poles = [p for p in poles if p not in below[0]]
        zeros = [z for z in zeros if z not in below[1]]
    resonant = [abs(p) / (2 * math.pi) for p in poles if p.imag > 0.0]
    top = max(min([excited_hz[1], *(f / 10.0 for f in resonant)]), excited_hz[0])
    return LinearPoles(Roots.of(poles), Roots.of(zeros), math.sqrt(excited_hz[0] * top))


def hysteretic_oscillator(
    mass: float, damping: float, stiffness: float, slope: float, decay: float, asymmetry: float
) -> Structure:
    """A mass on a spring with hysteretic stiffness: m y'' + c y' + k y + z = u, z a Bouc-Wen element driven by y.

    z' = slope y' - decay |y'| z - asymmetry y' |z|. In the notation of Noël and Schoukens (2016), with exponent 1,
    these are alpha, beta gamma and beta delta, of which only the products can be told apart. Drive in N, output in m.
    The arguments are where the search begins.

    Args:
        mass: M (kg).
        damping: C (N s/m).
        stiffness: K (N/m).
        slope: N/m.
        decay: 1/m.
        asymmetry: 1/m.
    """

    def build(values: Floats) -> Mirror:
        m, c, k, epsilon, alpha, beta = (float(v) for v in values)
        return Mirror(
            name="hysteretic oscillator",
            A=np.array([[0.0, 1.0], [-k / m, -c / m]]),
            B=np.array([[0.0], [1.0 / m]]),
            E=np.array([[0.0], [-1.0 / m]]),
            F=np.array([[1.0, 0.0]]),
            G=np.zeros((1, 1)),
            C=np.array([[1.0, 0.0]]),
            D=np.zeros((1, 1)),
            K=np.zeros((1, 1)),
            bouc_wen=(BoucWen(0.0, 0.0, epsilon, 0.0, alpha, beta),),
            plays=(),
            inverse=(),
        )

    parameters = (
        Parameter("mass", "kg", mass, lower=0.05 * mass),
        Parameter("damping", "N s/m", damping, lower=0.0),
        Parameter("stiffness", "N/m", stiffness, lower=0.0),
        Parameter("slope", "N/m", slope),
        Parameter("decay", "1/m", decay, lower=0.0),
        Parameter("asymmetry", "1/m", asymmetry),
    )
    return Structure("hysteretic oscillator", parameters, build)


# ------------------------------------------------------------------------------------------------ one axis of a mirror
class Axis(NamedTuple):
    """What one axis consists of."""

    model: BoucWen | PrandtlIshlinskii
    creep: Creep
    linear: LinearPoles | None


@dataclass(frozen=True, eq=False)
class AxisStructure(Structure):
    """A `Structure` of one axis, whose parts can be had by themselves; another process makes it again from `recipe`."""

    parts: Callable[[Floats], Axis] = field(kw_only=True)
    recipe: Callable[[], "AxisStructure"] = field(kw_only=True)

    def __reduce__(self) -> tuple[Callable[[], "AxisStructure"], tuple[()]]:
        """What pickles it: its closures cannot be."""
        return self.recipe, ()


def one_axis(
    name: str,
    model: BoucWen | PrandtlIshlinskii,
    *,
    linear: LinearPoles | None = None,
    creep: Creep = NO_CREEP,
    free: Sequence[str] = (),
    free_linear: bool = True,
    admissible: bool = False,
) -> AxisStructure:
    """One axis: hysteresis, behind it a linear part of unit gain where there is one (cascade), creep beside both.

    Of a Bouc-Wen model d1, epsilon, alpha and beta are fitted; beta, gamma and eta as shares of alpha, so that h stays
    bounded. Of a Prandtl-Ishlinskii model the weights are fitted, the thresholds are not. Each lag of the creep has a
    weight of its own. With the poles and zeros the delay of the recording chain is fitted.

    Args:
        name: Name of the mirror.
        model: The hysteresis at which the search begins.
        linear: The linear part at which it begins.
        creep: The creep at which it begins.
        free: What is fitted as well: d2, delta, gamma, eta, exponent of a Bouc-Wen model, widening of a
            Prandtl-Ishlinskii model.
        free_linear: Whether poles, zeros and the delay are fitted.
        admissible: Whether the slope of a Bouc-Wen model behind a slow reversal is kept from turning against d1.
    """
    hysteresis, make_model = (
        _bouc_wen_part(model, free, admissible) if isinstance(model, BoucWen) else _play_part(model, free)
    )
    lags, make_creep = _creep_part(creep, slow_gain(model))
    roots, make_linear = _linear_part(linear, free_linear)
    first, second = len(hysteresis), len(hysteresis) + len(lags)
    composition = "static" if linear is None else "cascade"

    def parts(values: Floats) -> Axis:
        return Axis(make_model(values[:first]), make_creep(values[first:second]), make_linear(values[second:]))

    def build(values: Floats) -> Mirror:
        axis = parts(values)
        system = None if axis.linear is None else axis.linear.system
        return mirror.assemble(name, composition, system, *_without_zeros(axis.model, axis.creep))

    def lag(time_constant_s: float) -> Mirror:
        return mirror.assemble(name, "static", None, PrandtlIshlinskii((), ()), Creep((1.0,), (time_constant_s,)))

    again = partial(
        one_axis,
        name,
        model,
        linear=linear,
        creep=creep,
        free=tuple(free),
        free_linear=free_linear,
        admissible=admissible,
    )

    def late(values: Floats) -> float:
        found = make_linear(values[second:])
        return 0.0 if found is None else found.delay_s

    beside = tuple((first + i, lag(tau)) for i, tau in enumerate(creep.time_constants_s))
    return AxisStructure(name, (*hysteresis, *lags, *roots), build, late, beside, parts=parts, recipe=again)


def _without_zeros(model: BoucWen | PrandtlIshlinskii, creep: Creep) -> tuple[BoucWen | PrandtlIshlinskii, Creep]:
    """The same without plays and lags that have no weight, which take time and add nothing."""
    if isinstance(model, PrandtlIshlinskii):
        kept = [(r, w) for r, w in zip(model.thresholds_v, model.weights_rad_v, strict=True) if w]
        model = replace(model, thresholds_v=tuple(r for r, _ in kept), weights_rad_v=tuple(w for _, w in kept))
    lags = [(w, tau) for w, tau in zip(creep.weights_rad_v, creep.time_constants_s, strict=True) if w]
    return model, Creep(tuple(w for w, _ in lags), tuple(tau for _, tau in lags))


def _bouc_wen_part(
    model: BoucWen, free: Sequence[str], admissible: bool
) -> tuple[tuple[Parameter, ...], Callable[[Floats], BoucWen]]:
    fastest = model.rate_limit_v_s if math.isfinite(model.rate_limit_v_s) else 1.0
    all_of_them = (
        Parameter("d1", "rad/V", model.d1_rad_v, linear=not admissible),
        Parameter(
            "epsilon", "rad/V", model.epsilon_rad_v, size=max(abs(model.epsilon_rad_v), 1e-3 * abs(model.d1_rad_v))
        ),
        Parameter("alpha", "1/V", model.alpha_1_v, 1e-3 * model.alpha_1_v, _STIFFEST * model.alpha_1_v),
        Parameter("beta over alpha", "", model.beta_1_v / model.alpha_1_v, -_RATIO, _RATIO, 0.1),
        Parameter("d2", "s/V", model.d2_s_v, -1.0 / fastest, 1.0 / fastest, 0.01 / fastest),
        Parameter("delta", "s/V", model.delta_s_v, -3.0 / fastest, 10.0 / fastest, 0.1 / fastest),
        Parameter("gamma over alpha", "", model.gamma_1_v / model.alpha_1_v, -_RATIO, _RATIO, 0.1),
        Parameter("eta over alpha", "", model.eta_1_v / model.alpha_1_v, -_RATIO, _RATIO, 0.1),
        # Derivatives need a change that stands above the error of the integration, which only another exponent needs.
        Parameter("exponent", "", model.exponent, 1.0, 10.0, 10.0),
    )
    used = [p for p in all_of_them if p.name.split()[0] in ("d1", "epsilon", "alpha", "beta", *free)]
    if admissible:  # 1 is where the slope behind a slow reversal is 0
        share = min(-model.epsilon_rad_v * model.reversal_swing / model.d1_rad_v, 0.95)
        used[1] = Parameter("epsilon over its limit", "", share, -10.0, 1.0, 0.1)

    def make(values: Floats) -> BoucWen:
        at = {p.name.split()[0]: float(v) for p, v in zip(used, values, strict=True)}
        alpha = at["alpha"]
        found = replace(
            model,
            d1_rad_v=at["d1"],
            epsilon_rad_v=-math.copysign(1.0, at["epsilon"] * at["d1"]) if admissible else at["epsilon"],
            alpha_1_v=alpha,
            beta_1_v=at["beta"] * alpha,
            d2_s_v=at.get("d2", model.d2_s_v),
            delta_s_v=at.get("delta", model.delta_s_v),
            gamma_1_v=at["gamma"] * alpha if "gamma" in at else model.gamma_1_v,
            eta_1_v=at["eta"] * alpha if "eta" in at else model.eta_1_v,
            exponent=at.get("exponent", model.exponent),
        )
        if not admissible:
            return found
        return replace(found, epsilon_rad_v=-at["epsilon"] * found.d1_rad_v / found.reversal_swing)

    return tuple(used), make


def _play_part(
    model: PrandtlIshlinskii, free: Sequence[str]
) -> tuple[tuple[Parameter, ...], Callable[[Floats], PrandtlIshlinskii]]:
    total = abs(slow_gain(model)) or 1.0
    count = len(model.thresholds_v)
    rising = math.copysign(1.0, slow_gain(model))
    bounds = (0.0, math.inf) if rising > 0.0 else (-math.inf, 0.0)
    parameters = [
        Parameter(f"weight at {r:.4g} V", "rad/V", w, *bounds, size=max(abs(w), 0.01 * total), linear=True)
        for r, w in zip(model.thresholds_v, model.weights_rad_v, strict=True)
    ]
    if "widening" in free:
        travel = max(model.thresholds_v) or 1.0
        most = travel / (model.rate_limit_v_s if math.isfinite(model.rate_limit_v_s) else 1.0)
        parameters.append(Parameter("widening", "s", max(model.widening_s, 0.01 * most), 0.0, 3 * most, 0.1 * most))

    def make(values: Floats) -> PrandtlIshlinskii:
        widening = float(values[count]) if len(values) > count else model.widening_s
        return replace(model, weights_rad_v=tuple(float(w) for w in values[:count]), widening_s=widening)

    return tuple(parameters), make


def _creep_part(creep: Creep, gain: float) -> tuple[tuple[Parameter, ...], Callable[[Floats], Creep]]:
    if not creep.weights_rad_v:
        return (), lambda _: creep
    least = 1e-3 * abs(gain)
    parameters = tuple(
        Parameter(f"creep at {tau:.4g} s", "rad/V", weight, size=max(abs(weight), least), linear=True)
        for tau, weight in zip(creep.time_constants_s, creep.weights_rad_v, strict=True)
    )

    def make(values: Floats) -> Creep:
        return replace(creep, weights_rad_v=tuple(float(v) for v in values))

    return parameters, make


def _linear_part(
    linear: LinearPoles | None, free: bool
) -> tuple[tuple[Parameter, ...], Callable[[Floats], LinearPoles | None]]:
    if linear is None or not free:
        return (), lambda _: linear
    parameters: list[Parameter] = []
    for kind, roots in (("pole", linear.poles), ("zero", linear.zeros)):
        for number, (f, damping) in enumerate(zip(roots.frequencies_hz, roots.dampings, strict=True), 1):
            parameters.append(Parameter(f"{kind} {number}", "Hz", f, lower=0.05 * f, upper=20.0 * f))
            if abs(damping) < 1.0:
                low, high = _DAMPING if kind == "pole" else (-_DAMPING[1], _DAMPING[1])
                parameters.append(Parameter(f"{kind} {number} damping", "", damping, low, high, 0.1 * abs(damping)))
    # A delay changes a response by as much as a pole does where it turns its phase by as much: by one radian there.
    fastest = 1.0 / (2.0 * math.pi * max(linear.poles.frequencies_hz))
    # A hysteresis that a model lacks looks like a delay in loops, so these move it no farther than a response allows.
    reach = min(_LONGEST * max(fastest, abs(linear.delay_s)), _ALLOWED * linear.delay_error_s)
    parameters.append(Parameter("delay", "s", linear.delay_s, linear.delay_s - reach, linear.delay_s + reach, fastest))

    def make(values: Floats) -> LinearPoles:
        at = iter(values)

        def moved(roots: Roots) -> Roots:
            pairs = [(float(next(at)), float(next(at)) if abs(d) < 1.0 else d) for d in roots.dampings]
            return Roots(tuple(f for f, _ in pairs), tuple(d for _, d in pairs))

        poles, zeros = moved(linear.poles), moved(linear.zeros)
        return replace(linear, poles=poles, zeros=zeros, delay_s=float(next(at)))

    return tuple(parameters), make
