"""The fast steering mirror: one plant form for every mirror, a linear system with a bank of hysteresis operators.

    x' = A x + B u + E z        q = F x + G u        z = H[q, q']        y = C x + D u + K z

Drive u in volts at the amplifier's input, output y in radians. All are deviations from rest at the bias voltage.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from microrad.core import kernels, lti
from microrad.core.arrays import Complexes, Floats, reals
from microrad.core.units import LEAST, MOST
from microrad.mirror.hysteresis import NO_CREEP, BoucWen, Creep, PrandtlIshlinskii, slow_gain, steepest_slope
from microrad.mission.tables import mirror as mirror_table


@dataclass(frozen=True, slots=True)
class Mirror:
    """A mirror in the plant form of this module, continuous in time, with its arrays named as there.

    Bouc-Wen elements come first in the rows of F and G and the columns of E and K, Prandtl-Ishlinskii operators after
    them. ``inverse`` names, by actuator, the hysteresis that a feedforward inverts, and ``inverse_creep`` the creep.
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
    plays: tuple[PrandtlIshlinskii, ...]
    inverse: tuple[BoucWen | PrandtlIshlinskii, ...]
    inverse_creep: tuple[Creep, ...] = ()

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
        """The mirror with each element replaced by its slow gain, for margins (Bouc-Wen: d1, plays: sum of weights)."""
        return self.linear([slow_gain(model) for model in self.bank])

    @property
    def bank(self) -> tuple[BoucWen | PrandtlIshlinskii, ...]:
        """The hysteresis elements in the order of the rows of F."""
        return (*self.bouc_wen, *self.plays)

    def response(self, drive_v: ArrayLike, step_s: float) -> Floats:
        """Outputs (rad) from rest at the bias, shape (samples,) for a drive of that shape, else (samples, outputs).

        Args:
            drive_v: Drives about the bias (V), linear between samples, shape (samples,) or (samples, actuators).
            step_s: Time between samples (s).

        Raises:
            ValueError: For drives of another shape, and where the mirror cannot be simulated at this step, with one
                that would do.

        Example:
            ```python
            import numpy as np
            from microrad import Mirror, PrandtlIshlinskii

            plays = PrandtlIshlinskii(thresholds_v=(0.0, 1.0, 3.0), weights_rad_v=(40e-6, 6e-6, 4e-6))
            mirror = Mirror.of(plays, numerator=[1.0], denominator=[1 / 6000**2, 2 * 0.02 / 6000, 1.0])
            time_s = np.arange(2000) * 1e-5
            print(np.ptp(mirror.response(10 * np.sin(2 * np.pi * 100 * time_s), step_s=1e-5)))
            ```
        """
        given = reals(drive_v, "drive_v")
        drive = np.ascontiguousarray(given[:, None] if given.ndim == 1 else given)
        if drive.ndim != 2 or drive.shape[1] != self.actuators or not drive.size or not np.isfinite(drive).all():
            raise ValueError(
                f"drive_v has shape {given.shape}: mirror {self.name!r} takes finite samples of shape "
                f"(samples, {self.actuators})"
            )
        if not LEAST <= step_s <= MOST:
            raise ValueError(f"step_s is {step_s} s: give the time between two samples, above 0")
        plant = discretise(self, step_s)
        output = np.empty((len(drive), self.axes))
        respond(plant, at_rest(plant), drive, output, np.empty((len(drive), 0)))
        if not np.isfinite(output).all():
            raise ValueError(f"mirror {self.name!r} gives no finite output to this drive at a step of {step_s:g} s")
        return output[:, 0] if given.ndim == 1 and self.axes == 1 else output

    def frequency_response(self, freq_hz: ArrayLike) -> Complexes:
        """Complex response with each element at its slow gain (rad/V), shape (frequencies, outputs, actuators).

        Args:
            freq_hz: Frequencies (Hz), shape (frequencies,).

        Raises:
            ValueError: For frequencies of another shape, or that are not finite.
        """
        freq = np.atleast_1d(reals(freq_hz, "freq_hz"))
        if freq.ndim != 1 or not np.isfinite(freq).all():
            raise ValueError(f"freq_hz has shape {freq.shape}: give one row of finite frequencies")
        return lti.frequency_response(self.linear_loop, freq)

    @classmethod
    def of(
        cls,
        hysteresis: BoucWen | PrandtlIshlinskii | float,
        numerator: ArrayLike = (1.0,),
        denominator: ArrayLike = (1.0,),
        *,
        creep: Creep = NO_CREEP,
        name: str = "mirror",
    ) -> "Mirror":
        """One axis: the hysteresis drives a linear part of gain 1 at rest, and creep is added behind it.

        Args:
            hysteresis: Model from the drive (V) to the angle (rad), or a gain (rad/V) for a mirror without.
            numerator: Coefficients of the linear part, highest power of s first; it is divided by its gain at rest.
            denominator: The same; every root has a real part below 0.
            creep: Creep beside it.
            name: What the mirror is called in messages.

        Raises:
            ValueError: For a linear part that is not strictly proper, not stable, or has no gain at rest.
        """
        model = hysteresis if isinstance(hysteresis, BoucWen | PrandtlIshlinskii) else BoucWen(hysteresis, *[0.0] * 5)
        for each in (model, creep):
            each.check()
        top, bottom = (
            np.atleast_1d(reals(c, f"{what} of mirror {name!r}"))
            for what, c in (("numerator", numerator), ("denominator", denominator))
        )
        if not all(c.ndim == 1 and c.size and np.isfinite(c).all() for c in (top, bottom)):
            raise ValueError(f"mirror {name!r}: numerator and denominator have to be rows of finite coefficients")
        power = np.trim_zeros(top, "f").size
        if power == bottom.size == 1 and bottom[0]:
            return assemble(name, "static", None, model, creep)
        if np.max(np.abs([*top, *bottom])) > lti.STEEPEST * abs(bottom[0]) > 0.0:
            raise ValueError(f"the denominator of mirror {name!r} begins with {bottom[0]:g}, nothing beside the others")
        if power >= bottom.size or bottom[0] == 0.0 or top[-1] == 0.0 or np.max(np.roots(bottom).real) >= 0.0:
            raise ValueError(
                f"the linear part of mirror {name!r} has a numerator of {top.size} and a denominator of {bottom.size} "
                "coefficients: give one that is strictly proper and stable (every root of the denominator left of the "
                "imaginary axis) and that passes a constant"
            )
        system = lti.modal_from_polynomials(top.tolist(), bottom.tolist())
        gain = float(lti.frequency_response(system, np.array([0.0]))[0, 0, 0].real)
        with np.errstate(all="ignore"):
            system = replace(system, C=system.C / gain, D=system.D / gain)
        if not all(np.isfinite(each).all() for each in (system.B, system.C)):
            raise ValueError(
                f"the linear part of mirror {name!r} has a gain at rest of {gain:g}: look at its coefficients"
            )
        return assemble(name, "cascade", system, model, creep)

    @classmethod
    def of_system(cls, system: lti.StateSpace, name: str = "mirror") -> "Mirror":
        """A mirror without hysteresis: a continuous linear system from drives (V) to outputs (rad).

        Args:
            system: Its matrices, stable, such as the ``system`` of `fit_frequency_response`.
            name: What the mirror is called in messages.

        Raises:
            ValueError: For a system that is not stable.
        """
        if system.order and np.max(np.linalg.eigvals(system.A).real) >= 0.0:
            raise ValueError(f"the linear system of mirror {name!r} is not stable: every pole has to have a decay")
        parts: dict[str, Any] = {key: np.zeros(shape) for key, shape in _no_bank(system).items()}
        parts |= {key: getattr(system, key) for key in "ABCD"}
        return cls(name=name, bouc_wen=(), plays=(), inverse=(), **parts)

    def linear(self, gains: Sequence[float]) -> lti.StateSpace:
        """The mirror with a gain in place of each element.

        Args:
            gains: One for each element of the bank.
        """
        through = np.array(gains, dtype=float)[:, None]
        return lti.StateSpace(
            self.A + self.E @ (through * self.F),
            self.B + self.E @ (through * self.G),
            self.C + self.K @ (through * self.F),
            self.D + self.K @ (through * self.G),
        )


def linear_part(table: mirror_table.LinearPart) -> tuple[lti.StateSpace, float]:
    """Linear part divided by its gain at the normalising frequency, and that gain: magnitude, with the sign of Re.

    The gain of the mirror belongs to its hysteresis model; cascading two models with a gain each squares it.

    Raises:
        ValueError: For coefficients whose poles cannot be told apart.
    """
    if table.numerator is None or table.denominator is None:
        zeros, poles = (np.array(roots, dtype=complex) for roots in table.roots)
        return lti.modal_from_roots(zeros, poles, table.normalise_at_hz), 1.0
    try:
        system = lti.modal_from_polynomials(table.numerator, table.denominator)
    except ValueError as error:
        raise ValueError(
            f"the linear part of the mirror: {error}; give poles and pole_dampings in place of numerator and "
            "denominator"
        ) from None
    response = complex(lti.frequency_response(system, np.array([table.normalise_at_hz]))[0, 0, 0])
    gain = math.copysign(abs(response), response.real)
    return replace(system, C=system.C / gain), gain


def hysteresis_model(
    table: mirror_table.Mirror | mirror_table.Comparison, rate_limit_v_s: float, bias_v: float
) -> BoucWen | PrandtlIshlinskii:
    """The hysteresis model of a mirror table, as a record.

    Args:
        table: A mirror, or its comparison model, with a Bouc-Wen or a Prandtl-Ishlinskii model.
        rate_limit_v_s: Rate of the drive beyond which a model that depends on it is held.
        bias_v: Resting drive, which a Bouc-Wen model needs.
    """
    if table.bouc_wen is not None:
        return BoucWen(**dict(table.bouc_wen), rate_limit_v_s=rate_limit_v_s, bias_v=bias_v)
    p = table.prandtl_ishlinskii
    assert p is not None  # the mission's own check
    return PrandtlIshlinskii(
        p.thresholds_v, p.weights_rad_v, p.widening_s, rate_limit_v_s if p.widening_s else math.inf
    )


def from_table(table: mirror_table.Mirror) -> Mirror:
    """One axis of a mirror table as it is, its output in the mirror's own angle."""
    return from_mission(table, hysteresis_model(table, table.rate_limit_v_s, table.bias_v))


def creep_model(table: mirror_table.Mirror) -> Creep:
    """The creep of a mirror table, as a record; without one, none."""
    return NO_CREEP if table.creep is None else Creep(table.creep.weights_rad_v, table.creep.time_constants_s)


def from_mission(
    table: mirror_table.Mirror, model: BoucWen | PrandtlIshlinskii, composition: str | None = None, times: float = 1.0
) -> Mirror:
    """Assemble one axis from the mission's linear part and creep, and a hysteresis model.

    cascade: the hysteresis drives the linear part (q = u, B = 0). additive: the linear gain drives the linear part and
    the hysteresis is added behind it through K. static: no linear part. Creep is added to the output in each of them.

    Args:
        table: The mission's mirror.
        model: Its hysteresis model, or another.
        composition: "cascade", "additive" or "static"; the table's where none is given.
        times: Factor on the table's creep: 2 where the model counts the line of sight and the table a mechanical angle.

    Raises:
        ValueError: For a composition that lacks its linear part.
    """
    system = None if table.linear is None else linear_part(table.linear)[0]
    creep = creep_model(table)
    creep = replace(creep, weights_rad_v=tuple(times * w for w in creep.weights_rad_v))
    return assemble(table.name, composition or table.composition, system, model, creep)


def assemble(
    name: str,
    composition: str,
    system: lti.StateSpace | None,
    model: BoucWen | PrandtlIshlinskii,
    creep: Creep = NO_CREEP,
) -> Mirror:
    """Assemble one axis from a linear part, a hysteresis model and the creep beside it.

    Args:
        name: What the mirror is called in messages.
        composition: "cascade", "additive" or "static", see `from_mission`.
        system: Linear part of unit gain, one input and one output; not used for "static".
        model: Hysteresis from the drive (V) to the angle (rad).
        creep: Creep that is added to the output.

    Raises:
        ValueError: For a composition that lacks its linear part.
    """
    if composition != "static" and system is None:
        raise ValueError(f'composition "{composition}" needs a linear part; give one or choose "static"')
    if system is None or composition == "static":
        system = lti.StateSpace(np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), np.zeros((1, 1)))
    bouc_wen, plays = _elements(model, split=composition == "additive")
    through_linear, direct = _routes(composition, len(bouc_wen) + len(plays))
    n, lags, elements = system.order, len(creep.weights_rad_v), through_linear.size
    A, E = np.zeros((n + lags, n + lags)), np.zeros((n + lags, elements))
    A[:n, :n], E[:n] = system.A, system.B @ through_linear[None, :]
    per_second = 1.0 / np.array(creep.time_constants_s)
    A[range(n, n + lags), range(n, n + lags)] = -per_second
    return Mirror(
        name=name,
        A=A,
        B=np.concatenate([np.zeros(n), per_second])[:, None],
        E=E,
        F=np.zeros((elements, n + lags)),
        G=np.ones((elements, 1)),
        C=np.hstack([system.C, np.array(creep.weights_rad_v)[None, :]]),
        D=np.zeros((1, 1)),
        K=direct[None, :],
        bouc_wen=bouc_wen,
        plays=plays,
        inverse=(model,),
        inverse_creep=(creep,),
    )


def _elements(
    model: BoucWen | PrandtlIshlinskii, split: bool
) -> tuple[tuple[BoucWen, ...], tuple[PrandtlIshlinskii, ...]]:
    """Bank of one model; split into its linear gain first and its hysteresis after it."""
    if isinstance(model, PrandtlIshlinskii):
        if not split or len(model.weights_rad_v) < 2 or model.thresholds_v[0] > 0.0:
            return (), (model,)
        first = PrandtlIshlinskii(model.thresholds_v[:1], model.weights_rad_v[:1])
        return (), (first, replace(model, thresholds_v=model.thresholds_v[1:], weights_rad_v=model.weights_rad_v[1:]))
    if not split:
        return (model,), ()
    return (replace(model, epsilon_rad_v=0.0), replace(model, d1_rad_v=0.0)), ()


def _routes(composition: str, elements: int) -> tuple[Floats, Floats]:
    """Which elements drive the linear part, and which are added to the output."""
    ones, first = np.ones(elements), np.eye(elements)[0]
    if composition == "cascade":
        return ones, 0.0 * ones
    return (first, ones - first) if composition == "additive" else (0.0 * ones, ones)


def combine(*mirrors: Mirror) -> Mirror:
    """Independent mirrors side by side: the axes, actuators and elements of the first, then of the next."""
    from scipy.linalg import block_diag

    bw = [len(m.bouc_wen) for m in mirrors]
    total = np.cumsum([0] + [len(m.bouc_wen) + len(m.plays) for m in mirrors])
    order = [int(t) + i for t, n in zip(total, bw, strict=False) for i in range(n)]
    order += [i for i in range(int(total[-1])) if i not in order]  # Bouc-Wen elements first
    parts: dict[str, Any] = {key: block_diag(*(getattr(m, key) for m in mirrors)) for key in "ABEFGCDK"}
    parts |= {key: parts[key][:, order] for key in "EK"} | {key: parts[key][order] for key in "FG"}
    banks = ("bouc_wen", "plays", "inverse", "inverse_creep")
    parts |= {key: sum((getattr(m, key) for m in mirrors), ()) for key in banks}
    return Mirror(name=" + ".join(m.name for m in mirrors), **parts)


def linearised(mirror: Mirror, gains: Sequence[float]) -> Mirror:
    """The mirror with a gain in place of each element, which its linear part takes in: no bank is left.

    Args:
        mirror: The mirror.
        gains: One for each element of its bank.
    """
    s = mirror.linear(gains)
    without: dict[str, Any] = {key: np.zeros(shape) for key, shape in _no_bank(s).items()}
    return replace(mirror, A=s.A, B=s.B, C=s.C, D=s.D, bouc_wen=(), plays=(), **without)


def _no_bank(system: lti.StateSpace) -> dict[str, tuple[int, int]]:
    """Shapes of the matrices of a bank without elements."""
    n, (outputs, inputs) = system.order, system.D.shape
    return {"E": (n, 0), "F": (0, n), "G": (0, inputs), "K": (outputs, 0)}


def discretise(mirror: Mirror, step_s: float, *, often: bool = False) -> kernels.Plant:
    """The mirror for a fixed step, with u and z linear over it.

    Args:
        mirror: The mirror, continuous in time.
        step_s: Length of a step.
        often: Whether it is simulated over many steps, as in a fit to long recordings: then its loops on one axis are
            unrolled whatever its size, which takes some seconds to compile once and half of the time to run.

    Raises:
        ValueError: Where q = F x closes a loop through one step that is no contraction; names a step that would do.
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
    one_axis = mirror.actuators == mirror.axes == 1
    return plant_arrays(step_s, (Ad, B0, B1, E0, E1), mirror, unroll=unrolled(mirror) or (often and one_axis))


def unrolled(mirror: Mirror) -> bool:
    """Whether the kernels' loops over this mirror are unrolled: see `kernels.Count`."""
    return _sizes(mirror) == kernels.UNROLLED


def _sizes(mirror: Mirror) -> dict[str, int]:
    return {
        "states": mirror.A.shape[0],
        "actuators": mirror.actuators,
        "outputs": mirror.axes,
        "elements": len(mirror.bouc_wen),
        "operators": len(mirror.plays),
    }


def plant_arrays(step_s: float, discrete: tuple[Floats, ...], mirror: Mirror, *, unroll: bool) -> kernels.Plant:
    """The kernel's arrays from a mirror and its discrete matrices.

    Args:
        step_s: Length of a step.
        discrete: Ad (states, states), B0 and B1 (states, actuators), E0 and E1 (states, elements); those that end in 0
            go with the value at the start of a step, those in 1 with that at its end.
        mirror: Gives F, G, C, D, K and the bank of hysteresis elements.
        unroll: Whether the kernels' loops over this mirror are unrolled.
    """
    Ad, B0, B1, E0, E1 = discrete
    n, odd = Ad.shape[0], Ad.shape[0] % 2  # the kernel pairs the states: an odd one gets an idle partner
    Ad = np.pad(Ad, (0, odd))
    neighbour = np.arange(n + odd) ^ 1
    near = np.eye(n + odd, dtype=bool) | (np.arange(n + odd)[:, None] == neighbour)

    def below(matrix: Floats) -> Floats:
        return np.pad(matrix.astype(float), ((0, odd), (0, 0)))

    def beside(matrix: Floats) -> Floats:
        return np.pad(matrix.astype(float), ((0, 0), (0, odd)))

    plant = kernels.Plant(
        step_s=float(step_s),
        **kernels.counts(unroll, **_sizes(mirror)),
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
        **bank_arrays(mirror.bouc_wen, mirror.plays),
    )
    return kernels.by_rows(plant)


def bank_arrays(bouc_wen: Sequence[BoucWen], plays: Sequence[PrandtlIshlinskii]) -> dict[str, Any]:
    """Hysteresis elements as the kernels' arrays, by field of `kernels.Plant` and `kernels.ForwardBank`.

    Args:
        bouc_wen: Bouc-Wen elements.
        plays: Prandtl-Ishlinskii operators, which come after them.
    """
    return {
        "bouc_wen": kernels.bouc_wen_rows([b.row for b in bouc_wen]),
        "operator": np.array(
            [(p.widening_s, p.rate_limit_v_s, *p.polynomial_rad, p.reach_v) for p in plays], dtype=float
        ).reshape(-1, 6),
        "play_start": np.cumsum([0] + [len(p.thresholds_v) for p in plays]).astype(np.uint64),
        "play_threshold": np.array([r for p in plays for r in p.thresholds_v], dtype=float),
        "play_weight": np.array([w for p in plays for w in p.weights_rad_v], dtype=float),
    }


def contraction(mirror: Mirror, step_s: float) -> float:
    """Bound on how much of an error in z at the end of a step returns through F and the steepest slope of the bank.

    Below 1 the step can be solved by repetition; 0 where nothing is fed back.

    Args:
        mirror: The mirror, continuous in time.
        step_s: Length of a step.

    Raises:
        ValueError: Where an element that is fed back has no bound on its slope, see `hysteresis.steepest_slope`.
    """
    fed = np.any(mirror.F, axis=1)
    if not np.any(fed):
        return 0.0
    end = lti.first_order_hold(mirror.A, mirror.E, step_s)[2]
    steepest = [steepest_slope(model) for model, is_fed in zip(mirror.bank, fed, strict=True) if is_fed]
    returning = (mirror.F @ end)[np.ix_(fed, fed)]  # what is not fed cannot return
    return float(np.linalg.norm(returning * np.array(steepest)[None, :], np.inf))


class Retimed(NamedTuple):
    """Matrices of a plant whose state has no part of the end of its step: see `kernels.Ensemble`, by those names."""

    B: Floats
    E: Floats
    H: Floats
    G: Floats
    D: Floats
    K: Floats


def retimed(plant: kernels.Plant | kernels.PlayPlant) -> Retimed:
    """The plant with u and z in each product once.

    Args:
        plant: The plant.
    """
    return Retimed(
        B=plant.B0 + kernels.advanced(plant, plant.B1),
        E=kernels.advanced(plant, plant.E1) + plant.E_held - plant.E1,
        H=plant.F @ plant.E1,
        G=plant.G + plant.F @ plant.B1,
        D=plant.D + plant.C @ plant.B1,
        K=plant.K + plant.C @ plant.E1,
    )


def respond(plant: kernels.Plant, state: kernels.PlantState, drive: Floats, output: Floats, bank: Floats) -> None:
    """`kernels.open_loop`, for a mirror of another size than the paper's by columns, which is faster.

    Args:
        plant: The plant.
        state: Its state, at rest or as this function left it.
        drive: Drive about the bias, in V, shape (samples, actuators).
        output: Outputs about those at rest, shape (samples, outputs); written.
        bank: Outputs of the hysteresis elements, shape (samples, elements), or of the first few; written.
    """
    if isinstance(plant.states, tuple):
        kernels.open_loop(plant, state, drive, output, bank)
        return
    turned, elements, outputs = retimed(plant), len(plant.F), len(plant.C)
    inputs = elements + turned.B.shape[1]

    def flat(matrix: Floats) -> Floats:
        return np.ravel(np.pad(matrix, [(0, -size % 4) for size in matrix.shape]), order="F")

    def memory(size: int) -> Floats:
        return np.zeros(size + -size % 4)

    columns = kernels.Columns(
        held=flat(np.hstack([turned.E, turned.B])),
        seen=flat(np.vstack([plant.F, plant.C])),
        drives=flat(np.vstack([np.hstack([turned.H, turned.G]), np.zeros((outputs, inputs))])),
        outputs=flat(np.vstack([np.zeros((elements, inputs)), np.hstack([turned.K, turned.D])])),
        states=memory(plant.diagonal.size),
        inputs=memory(inputs),
        sums=memory(elements + outputs),
    )
    kernels.open_loop_by_columns(plant, columns, state, drive, output, bank)


def at_rest(plant: kernels.Plant) -> kernels.PlantState:
    """A fresh state of the plant: everything zero, which is rest at the bias."""
    m, bouc_wen = len(plant.actuators), len(plant.elements)
    return kernels.PlantState(
        x=np.zeros(plant.diagonal.size),
        x_next=np.zeros(plant.diagonal.size),
        u=np.zeros(m),
        u_next=np.zeros(m),
        y=np.zeros(len(plant.outputs)),
        bank=np.zeros((bouc_wen + len(plant.operators), 4)),
        play=np.zeros(plant.play_threshold.size),
        clamped=np.zeros(bouc_wen + len(plant.operators), dtype=np.int64),
    )
