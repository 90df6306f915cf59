"""A fine-pointing loop under a controller as the kernel's arrays, and its state at the begin of a run."""

import math
import zlib
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from microrad import mirror
from microrad.core import kernels, lti
from microrad.core.arrays import Floats
from microrad.loop import disturbance
from microrad.loop.control import adaptive_arrays, amplifier_factor, at_the_begin, inverse_arrays, no_feedforward
from microrad.loop.pointing_loop.loop import ForwardHysteresis, LoopController, PointingLoop
from microrad.loop.sensor import StrainGauge
from microrad.mirror.model import bank_arrays

References = tuple[disturbance.Reference, ...]

LANES = kernels.LANES
"""Runs that the kernel advances side by side; a batch is never smaller."""


@dataclass(frozen=True, slots=True)
class Shaping:
    """The disturbances of all axes as one set of arrays for the kernel, with what starts it."""

    diagonal: Floats
    coupling: Floats
    noise: Floats
    output: Floats
    purpose: NDArray[np.uint64]
    parts: tuple[tuple[int, disturbance.Discrete, int], ...]  # first state, model, first purpose


PURPOSES_OF_ONE = 256  # streams set aside for each disturbance of an axis


def purpose_of(name: str, axis: int) -> int:
    """First stream of random numbers of a disturbance: it goes by its name, so leaving another out does not change it.

    Args:
        name: Name of the disturbance.
        axis: Number of its axis, from 0.
    """
    return (zlib.crc32(name.encode()) % (1 << 16) * 4 + axis) * PURPOSES_OF_ONE


def _refuse_shared(loop: PointingLoop) -> None:
    """Raise ValueError for two disturbances with the same streams: of one name on an axis, or of names that collide."""
    for axis, several in enumerate(loop.disturbances):
        names = [each.name for each in several]
        if len(set(names)) < len(names):
            raise ValueError(f"two disturbances of one axis share a name: {', '.join(names)}; give each its own")
        taken: dict[int, str] = {}
        for name in names:
            other = taken.setdefault(purpose_of(name, axis), name)
            if other != name:
                raise ValueError(
                    f"the disturbances {other!r} and {name!r} of one axis would take the same random numbers, which go "
                    "by a short code of the name, and these two have the same; change one of the names"
                )


def combined_shaping(loop: PointingLoop) -> Shaping:
    """Disturbances of all axes side by side, each at an even state so that pairs stay pairs.

    Raises:
        ValueError: Two would share their random numbers, or the states of one do not come in pairs.
    """
    _refuse_shared(loop)
    parts, states, sources = [], 0, 0
    for i, several in enumerate(loop.disturbances):
        for each in several:
            model = disturbance.discretise(each, loop.timing.step_s)
            parts.append((i, states, sources, purpose_of(each.name, i), model))
            states += model.Ad.shape[0] + model.Ad.shape[0] % 2
            sources += model.Bd.shape[1]
    diagonal, coupling = np.zeros(states), np.zeros(states)
    noise, output = np.zeros((states, sources)), np.zeros((loop.axes, states))
    purposes = np.zeros(sources, dtype=np.uint64)
    for axis, at, source, purpose, model in parts:
        n, w = model.Bd.shape
        partner = np.arange(n) ^ 1
        pairs = np.pad(model.Ad, (0, n % 2))
        if np.any(np.where(np.eye(n, dtype=bool) | (np.arange(n)[:, None] == partner), 0.0, model.Ad)):
            raise ValueError("a disturbance's states do not come in pairs: give its filter in modal form")
        turning = 2 * model.line_amplitude_rad.size  # lines are turned by a sine and a cosine that no processor rounds
        kept = np.arange(n) < turning
        own, beside = np.diag(model.Ad), pairs[np.arange(n), partner]
        diagonal[at : at + n] = np.where(kept, own, lti.decay_to_bits(own, lti.EXACT_BITS))
        coupling[at : at + n] = np.where(kept, beside, lti.to_bits(beside, lti.EXACT_BITS))
        noise[at : at + n, source : source + w] = model.Bd
        output[axis, at : at + n] = model.C[0]
        purposes[source : source + w] = purpose + np.arange(w)
    starts = tuple((at, model, purpose) for _, at, _, purpose, model in parts)
    return Shaping(diagonal, coupling, noise, output, purposes, starts)


def arrays(
    loop: PointingLoop, controller: LoopController, seed: int, shaping: Shaping | None = None
) -> kernels.Ensemble:
    """The loop and its controller as the kernel's arrays.

    Args:
        loop: The loop.
        controller: The controller of all its axes.
        seed: Seed of the random numbers, of which 64 bits count.
        shaping: The loop's `combined_shaping`, where it is at hand.

    Raises:
        ValueError: For a controller that does not fit.
    """
    check_controller(loop, controller)
    drive, timing = loop.drive, loop.timing
    plant = mirror.discretise(loop.mirror, timing.step_s)
    turned = mirror.retimed(plant)
    shaping = shaping or combined_shaping(loop)
    exact = partial(lti.to_bits, bits=lti.EXACT_BITS)
    inverse = controller.inverse or no_feedforward(loop.mirror)
    row = [drive.minimum_v, drive.maximum_v, drive.drive_resolution_v, amplifier_factor(drive, timing.step_s)]
    row += [drive.slew_v_s * timing.step_s, *loop.drive_range_v]
    actuators = loop.mirror.actuators
    gauge = loop.gauge or StrainGauge(0.0, 0.0)
    found = kernels.Ensemble(
        step_s=timing.step_s,
        feedback=plant.feedback,
        direct=plant.direct,
        diagonal=lti.decay_to_bits(plant.diagonal, lti.EXACT_BITS),
        coupling=exact(plant.coupling),
        rest=plant.rest._replace(value=exact(plant.rest.value)),
        By=exact(turned.B),
        E=exact(turned.E),
        F=exact(plant.F),
        H=exact(turned.H),
        G=exact(turned.G),
        Cy=exact(plant.C),
        Dy=exact(turned.D),
        Ky=exact(turned.K),
        bouc_wen=plant.bouc_wen,
        operator=plant.operator,
        play_start=plant.play_start,
        play_threshold=plant.play_threshold,
        play_weight=plant.play_weight,
        optics=np.asarray(exact(loop.optics), dtype=float),
        shaping_diagonal=shaping.diagonal,
        shaping_coupling=shaping.coupling,
        shaping_noise=exact(shaping.noise),
        shaping_output=exact(shaping.output),
        purpose=shaping.purpose,
        seed=np.array([seed & 0xFFFFFFFF, seed >> 32 & 0xFFFFFFFF], dtype=np.uint64),
        steps_per_sample=timing.steps_per_sample,
        delay_steps=timing.delay_steps,
        sensor_delay_steps=loop.optical.delay_steps,
        sensor_every=loop.optical.every,
        optical_noise=np.full(loop.axes, loop.optical.noise_rad),
        optical_resolution=loop.optical.resolution_rad,
        field_of_view=loop.optical.field_of_view_rad,
        gauge_noise=gauge.noise_rad,
        gauge_resolution=gauge.resolution_rad,
        feedforward=controller.inverse is not None,
        A=np.asarray(controller.system.A, dtype=float),
        B=np.asarray(controller.system.B, dtype=float),
        C=np.asarray(controller.system.C, dtype=float),
        D=np.asarray(controller.system.D, dtype=float),
        L=np.asarray(controller.anti_windup, dtype=float),
        actuator=np.tile(np.array(row), (actuators, 1)),
        **inverse_arrays(inverse, timing.period_s),
        forward=forward_arrays(controller.forward, actuators, timing.period_s),
        **adaptive_arrays(controller.adaptation, timing.period_s),
    )
    return kernels.by_rows(found)


def forward_arrays(of: ForwardHysteresis | None, actuators: int, period_s: float) -> kernels.ForwardBank:
    """The hysteresis that a controller runs on the wanted motion as the kernel's arrays; empty ones where it runs none.

    Args:
        of: The elements, or None.
        actuators: Number of actuators.
        period_s: Control period.
    """
    bank = of or ForwardHysteresis((), (), np.zeros((actuators, 0)))
    found = kernels.ForwardBank(period_s, **bank_arrays(bank.bouc_wen, bank.plays), drives=bank.drives)
    return kernels.by_rows(found)


def check_controller(loop: PointingLoop, controller: LoopController) -> None:
    """Raise ValueError if the controller does not fit the loop.

    Args:
        loop: The loop.
        controller: The controller of all its axes.

    Raises:
        ValueError: It has numbers that are not finite, or another size than the loop's.
    """
    s, m = controller.system, loop.mirror
    inputs = loop.axes + m.axes + loop.axes
    elements = 0 if controller.forward is None else len(controller.forward.bank)
    outputs = m.actuators * (4 if controller.adaptation else 3 if controller.inverse else 1) + elements
    order = s.A.shape[0]
    wanted = {"A": (order, order), "B": (order, inputs), "C": (outputs, order), "D": (outputs, inputs)}
    matrices = {**{key: getattr(s, key) for key in "ABCD"}, "L": controller.anti_windup}
    for key, shape in {**wanted, "L": (order, m.actuators)}.items():
        found = matrices[key].shape
        if found != shape:
            raise ValueError(
                f"controller {controller.name!r}: matrix {key} has the shape {found}, the loop needs {shape} "
                f"({loop.axes} optical, {m.axes} gauge and {loop.axes} reference inputs; {outputs} outputs)"
            )
    for key, matrix in matrices.items():
        if not np.all(np.isfinite(matrix)):
            raise ValueError(f"controller {controller.name!r}: matrix {key} holds a number that is not finite")


def start(
    loop: PointingLoop,
    p: kernels.Ensemble,
    first_run: int,
    references: Sequence[References] = (),
    shaping: Shaping | None = None,
) -> kernels.EnsembleState:
    """State at the begin of a batch of runs.

    Mirror and controller are at rest, the disturbance is drawn from its stationary distribution in the runs' streams.

    Args:
        loop: The loop.
        p: Its arrays.
        first_run: Number of the first run of the batch.
        references: References of each run, by axis, where they are not the loop's.
        shaping: The loop's `combined_shaping`, where it is at hand.
    """
    n, m, outputs, axes = p.diagonal.size, p.actuator.shape[0], p.Cy.shape[0], loop.axes
    runs = np.array([first_run], dtype=np.uint64)
    words = 4 * (-(-(axes + outputs) // 4))
    samples_late = -(-p.delay_steps // p.steps_per_sample)

    state = kernels.EnsembleState(
        first_run=runs,
        place=np.zeros(3, dtype=np.int64),
        x=_rows(n),
        x_next=_rows(n),
        drive=_rows(kernels.DRIVE_FIELDS * m),
        q=_rows(p.G.shape[0]),
        z=_rows(p.G.shape[0]),
        bank=_rows(kernels.BANK_FIELDS * p.G.shape[0]),
        play=_rows(p.play_threshold.size),
        y=_rows(outputs),
        shaping=start_disturbance(shaping or combined_shaping(loop), p, runs),
        disturbance=_rows(axes),
        gauss=_rows(4 * p.purpose.size),
        sensor_gauss=_rows(words),
        error=_rows(axes),
        error_ring=_rows((p.sensor_delay_steps + 1) * axes),
        measured=_rows(p.B.shape[1]),
        xc=_rows(p.A.shape[0]),
        xc_next=_rows(p.A.shape[0]),
        output=_rows(p.C.shape[0]),
        command=_rows((samples_late + 1) * m),
        target=_rows(2 * m),
        inverse=_rows(p.inverse_bouc_wen.shape[0]),
        inverse_play=_rows(p.inverse_play_threshold.size),
        inverse_lag=_rows(p.inverse_lag_keep.size),
        forward_z=_rows(p.forward.drives.shape[1]),
        forward_bank=_rows(kernels.BANK_FIELDS * p.forward.drives.shape[1]),
        forward_play=_rows(p.forward.play_threshold.size),
        learnt=_rows(p.adaptive_weight.size * kernels.PLAY_FIELDS),
        track=_rows(len(p.adaptive) * kernels.TRACK_FIELDS),
        work=_rows(m),
        sum=_rows(axes),
        sum_square=_rows(axes),
        largest=_rows(1),
        counts=_rows(kernels.COUNT_FIELDS),
        histogram=np.zeros((LANES, kernels.BINS), dtype=np.int32),
        drawn=np.zeros(0),
    )
    for rows, begin in zip((state.learnt, state.track), at_the_begin(p), strict=True):
        rows.reshape(-1, LANES)[: begin.size] = begin.reshape(-1, 1)
    shaped = lti.to_bits(p.shaping_output @ state.shaping.reshape(-1, LANES)[: p.shaping_diagonal.size], lti.EXACT_BITS)
    state.disturbance[:] = shaped.ravel()
    state.error[:] = (shaped + reference(loop, 0, 0, references)[0, :axes]).ravel()
    state.error_ring[:] = np.tile(state.error, p.sensor_delay_steps + 1)
    return state


def start_disturbance(shaping: Shaping, p: kernels.Ensemble, runs: NDArray[np.uint64]) -> Floats:
    """States of all disturbances at the begin, (states, LANES) in a row: stationary, and lines with random phases.

    Args:
        shaping: The disturbances of all axes.
        p: The loop's arrays, for the seed.
        runs: Number of the first run of the batch, shape (1,).
    """
    states = _rows(p.shaping_diagonal.size).reshape(-1, LANES)
    for at, model, purpose in shaping.parts:
        n = model.Ad.shape[0]
        numbers = np.zeros(4 * (-(-2 * n // 4)) * LANES)
        kernels.gaussian_kernel(p.seed, runs, np.uint64(kernels.START_PURPOSE + purpose), 0, numbers)
        drawn = numbers.reshape(-1, LANES)
        begin = disturbance.initial_state(model, drawn[:n], uniform(drawn[n : 2 * n]))
        states[at : at + n] = lti.to_bits(begin, lti.EXACT_BITS)
    return states.ravel()


def _rows(count: int) -> Floats:
    """Zeros, at least one row of runs: rows begin where a cache line does, so that no wide load needs two lines."""
    size, line = max(count, 1) * LANES, 8
    room = np.zeros(size + line)
    begin = -room.ctypes.data // room.itemsize % line
    return room[begin : begin + size]


def uniform(gaussians: Floats) -> Floats:
    """Phases, uniform from 0 to 2 pi, from standard normal numbers."""
    from scipy.special import ndtr

    return np.asarray(2.0 * math.pi * ndtr(gaussians))


def reference(loop: PointingLoop, begin: int, end: int, references: Sequence[References] = ()) -> Floats:
    """Reference (rad) at some control samples: (samples, axes, 1), one for all runs, or (samples, axes, LANES).

    Where the loop has what no controller knows, the axes stand twice: with that first, then without it.

    Args:
        loop: The loop, for its clock and its own references.
        begin: First control sample.
        end: Last control sample, included.
        references: References of each run, by axis, where they are not the loop's; runs behind them have those of the
            last one.
    """
    time: Floats = np.arange(begin, end + 1, dtype=float) * loop.timing.period_s
    each = [np.stack([r.at(time) for r in of], axis=1) for of in references or (loop.references,)]
    each += each[-1:] * (LANES - len(each) if references else 0)
    known = np.stack(each, axis=2)
    if loop.unknown:
        known = np.hstack([known + np.stack([u.at(time) for u in loop.unknown], axis=1)[:, :, None], known])
    return np.ascontiguousarray(known)
