"""The sampled loop as one linear system: stability, stationary errors by source, response by frequency.

The same recursions as the kernel's, with each hysteresis element replaced by its slow gain and without limits,
quantisation or inverse: what is linear of the loop is here exactly, so the simulation can be held against it.

The matrices of many loops, which differ by their mirrors alone, stand behind each other in stacks: shapes that are said
here are then those of the last axes.
"""

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from microrad.core import lti
from microrad.core.arrays import Complexes, Floats
from microrad.loop import disturbance
from microrad.loop.control import amplifier_factor
from microrad.loop.pointing_loop.loop import LoopController, PointingLoop, in_band_gain
from microrad.mirror.hysteresis import slow_gain


@dataclass(frozen=True, slots=True)
class Source:
    """A noise of the loop: its name, and its columns among those of the plant step or of the control sample."""

    name: str
    columns: slice
    sampled: bool


@dataclass(frozen=True, slots=True)
class Line:
    """A disturbance line: the name of its disturbance, its two states, which turn for ever, and its amplitude (rad)."""

    name: str
    states: slice
    amplitude_rad: float


@dataclass(frozen=True, slots=True)
class Layout:
    """Where the states of a loop without controller stand.

    Commands are kept by age in control samples, errors by age in plant steps; ``held`` is the last optical reading.
    """

    mirror: slice
    drive: slice
    commands: slice
    shaping: slice
    errors: slice
    held: slice

    @property
    def order(self) -> int:
        """Number of states."""
        return int(self.held.stop)


@dataclass(frozen=True, slots=True)
class OpenLoop:
    """The loop without its controller, over one plant step and around a control sample.

    A plant step j of a sample is s <- steps[j] s + noise g with unit white g. ``error`` (axes), ``mirror`` (outputs)
    and ``drive`` (actuators) read the state, ``reading`` takes what the optical sensor sees from it. ``shift`` ages the
    commands by a sample, and a new one goes to the rows ``newest``. No noise reaches the states of the ``lines``.
    """

    loop: PointingLoop
    at: Layout
    steps: tuple[Floats, ...]
    noise: Floats
    sources: tuple[Source, ...]
    error: Floats
    mirror: Floats
    drive: Floats
    reading: Floats
    shift: Floats
    newest: slice
    lines: tuple[Line, ...]


def open_loop(loop: PointingLoop, mirrors: lti.StateSpace | None = None) -> OpenLoop:
    """The matrices of the loop without controller; the reference is left out (zero).

    Args:
        loop: The loop.
        mirrors: A stack of linear mirrors, continuous, of the size of the loop's own, that take the place of that one.
    """
    linear, m, axes = mirrors or loop.mirror.linear_loop, loop.mirror.actuators, loop.axes
    each_axis = [(i, each) for i, several in enumerate(loop.disturbances) for each in several]
    parts = [(i, each.name, disturbance.discretise(each, loop.timing.step_s)) for i, each in each_axis]
    at = _layout(loop, sum(d.Ad.shape[0] for _, _, d in parts))
    mirror = np.zeros((*linear.C.shape[:-1], at.order))
    drive, error = (np.zeros((rows, at.order)) for rows in (m, axes))
    mirror[..., at.mirror], mirror[..., at.drive], drive[:, at.drive] = linear.C, linear.D, np.eye(m)
    shaping = _Shaping(at, axes)
    for i, name, model in parts:
        shaping.add(i, name, model)
    still = shaping.base
    still[at.commands, at.commands] = np.eye(at.commands.stop - at.commands.start)
    still[at.held, at.held] = np.eye(axes)
    still[at.errors.start + axes : at.errors.stop, at.errors.start : at.errors.stop - axes] = np.eye(
        at.errors.stop - at.errors.start - axes
    )
    now = slice(at.errors.start, at.errors.start + axes)
    through = shaping.output - loop.optics @ mirror
    noise = np.hstack([np.zeros((at.order, 0)), *shaping.noise])
    noise[now] = shaping.output @ noise
    error[:, now] = np.eye(axes)
    reading = np.zeros((axes, at.order))
    reading[:, at.errors.stop - axes : at.errors.stop] = np.eye(axes)
    held = lti.first_order_hold(linear.A, linear.B, loop.timing.step_s)
    return OpenLoop(
        loop=loop,
        at=at,
        steps=tuple(_step(loop, at, still, j, through, held) for j in range(loop.timing.steps_per_sample)),
        noise=noise,
        sources=tuple(shaping.sources),
        error=error,
        mirror=mirror,
        drive=drive,
        reading=reading,
        shift=_shift(at, m),
        newest=slice(at.commands.start, at.commands.start + m),
        lines=tuple(shaping.lines),
    )


def _layout(loop: PointingLoop, shaping: int) -> Layout:
    m, axes = loop.mirror.actuators, loop.axes
    samples_late = -(-loop.timing.delay_steps // loop.timing.steps_per_sample)
    sizes = [loop.mirror.linear_loop.order, m, (samples_late + 1) * m, shaping]
    sizes += [(loop.optical.delay_steps + 1) * axes, axes]
    edges = [0, *(int(edge) for edge in np.cumsum(sizes))]
    return Layout(*(slice(a, b) for a, b in pairwise(edges)))


class _Shaping:
    """Gathers the disturbances' own maps, noises and outputs, one behind the other."""

    def __init__(self, at: Layout, axes: int) -> None:
        self.base = np.zeros((at.order, at.order))
        self.output = np.zeros((axes, at.order))
        self.noise: list[Floats] = []
        self.sources: list[Source] = []
        self.lines: list[Line] = []
        self._next, self._columns = at.shaping.start, 0

    def add(self, axis: int, name: str, model: disturbance.Discrete) -> None:
        """One disturbance of an axis."""
        here = slice(self._next, self._next + model.Ad.shape[0])
        columns = slice(self._columns, self._columns + model.Bd.shape[1])
        self.base[here, here], self.output[axis, here] = model.Ad, model.C[0]
        block = np.zeros((self.base.shape[0], model.Bd.shape[1]))
        block[here] = model.Bd
        self.noise.append(block)
        self.sources.append(Source(name, columns, sampled=False))
        for i, amplitude in enumerate(model.line_amplitude_rad.tolist()):
            self.lines.append(Line(name, slice(here.start + 2 * i, here.start + 2 * i + 2), amplitude))
        self._next, self._columns = here.stop, columns.stop


def _step(
    loop: PointingLoop, at: Layout, still: Floats, j: int, through: Floats, held: tuple[Floats, Floats, Floats]
) -> Floats:
    """The map of plant step j: the amplifier follows the command that is due, the mirror the drive, the error both."""
    timing, m, (Ad, B0, B1) = loop.timing, loop.mirror.actuators, held
    follow = amplifier_factor(loop.drive, timing.step_s)
    age = -((j - timing.delay_steps) // timing.steps_per_sample)
    due = slice(at.commands.start + age * m, at.commands.start + (age + 1) * m)
    A = np.broadcast_to(still, (*Ad.shape[:-2], *still.shape)).copy()
    A[..., at.mirror, at.mirror], A[..., at.mirror, at.drive] = Ad, B0 + B1 * (1.0 - follow)
    A[..., at.drive, at.drive] = (1.0 - follow) * np.eye(m)
    A[..., at.mirror, due] += B1 * follow
    A[..., at.drive, due] += follow * np.eye(m)
    A[..., at.errors.start : at.errors.start + loop.axes, :] = through @ A
    return A


def _shift(at: Layout, m: int) -> Floats:
    """Ages the commands by a sample; the newest stays in place until it is replaced."""
    A = np.eye(at.order)
    for row in range(at.commands.stop - m, at.commands.start, -m):
        A[row : row + m] = 0.0
        A[row : row + m, row - m : row] = np.eye(m)
    return A


@dataclass(frozen=True, slots=True)
class ClosedLoop:
    """The loop under a controller, linear: a map for each control sample of a sensor period and its plant steps.

    States: those of `OpenLoop`, then the controller's. ``samples[i]`` is the control sample's own map and
    ``sample_noise[i]`` takes the readings' noise, unit white sequences, to the states; ``steps`` and ``step_noise`` are
    as in `OpenLoop`.
    """

    open: OpenLoop
    controller: LoopController
    samples: tuple[Floats, ...]
    sample_noise: tuple[Floats, ...]
    steps: tuple[Floats, ...]
    step_noise: Floats
    sources: tuple[Source, ...]

    @property
    def monodromy(self) -> Floats:
        """The map over one period of the optical sensor, from before its sample to before the next."""
        total = np.eye(self.step_noise.shape[0])
        for sample in self.samples:
            total = sample @ total
            for step in self.steps:
                total = step @ total
        return total

    @property
    def poles(self) -> Complexes:
        """Poles z over a period of the optical sensor, disturbances left out, shape (poles,)."""
        keep = _without_disturbances(self)
        return np.asarray(np.linalg.eigvals(self.monodromy[..., keep, :][..., keep]), dtype=complex)

    def worst_pole(self) -> tuple[float, float]:
        """Largest |z| over a control sample among the poles, disturbances left out, and its frequency in Hz."""
        poles, period = self.poles, self.open.loop.timing.period_s * len(self.samples)
        at = int(np.argmax(np.abs(poles)))
        size = float(np.abs(poles[at])) ** (1.0 / len(self.samples))
        return size, float(abs(np.angle(poles[at])) / (2.0 * math.pi * period))


def _without_disturbances(closed: ClosedLoop) -> NDArray[np.bool_]:
    """All states but the disturbances' own, whose lines lie on the unit circle whatever the loop does."""
    keep = np.ones(closed.step_noise.shape[0], dtype=bool)
    keep[closed.open.at.shaping] = False
    return keep


def straightened(controller: LoopController, loop: PointingLoop) -> LoopController:
    """The controller with its inverse replaced by the gain that it has on a mirror without hysteresis.

    So are the elements of a feedforward: by their slow gains.

    Args:
        controller: The controller of all axes; one without either is returned as it is.
        loop: The loop, for the gain of its mirror.
    """
    s, m = controller.system, loop.mirror.actuators
    if (forward := controller.forward) is not None:
        slow = forward.drives * [slow_gain(model) for model in forward.bank]
        system = lti.StateSpace(s.A, s.B, s.C[:m] + slow @ s.C[m:], s.D[:m] + slow @ s.D[m:])
        return LoopController(controller.name, system, controller.anti_windup)
    if controller.inverse is None:
        return controller
    gain = np.linalg.inv(in_band_gain(loop.mirror))
    C, D = s.C[:m] + gain @ s.C[m : 2 * m], s.D[:m] + gain @ s.D[m : 2 * m]
    return LoopController(controller.name, lti.StateSpace(s.A, s.B, C, D), controller.anti_windup)


def close(loop: PointingLoop, controller: LoopController, mirrors: lti.StateSpace | None = None) -> ClosedLoop:
    """The linear loop under a controller, whose inverse counts as the reciprocal of the slow gain.

    Args:
        loop: The loop.
        controller: The controller of all its axes.
        mirrors: A stack of linear mirrors as for `open_loop`; the inverse stays that of the loop's own.
    """
    o, c = open_loop(loop, mirrors), straightened(controller, loop)
    s, n, axes, outputs = c.system, o.at.order, loop.axes, loop.mirror.axes
    whole, readings = n + s.order, axes + outputs
    read = np.zeros((*o.mirror.shape[:-2], readings, whole))
    read[..., :axes, o.at.held], read[..., axes:, :n] = np.eye(axes), o.mirror
    act, from_readings = np.eye(whole), np.zeros((whole, readings))
    act[:n, :n] = o.shift
    from_readings[o.newest], from_readings[n:] = s.D[:, :readings], s.B[:, :readings]
    act[o.newest] = 0.0
    act[o.newest, n:], act[n:, n:] = s.C, s.A
    act = act + from_readings @ read
    take, into = np.eye(whole), np.zeros((whole, readings))  # a new optical reading, and its noise
    take[o.at.held] = 0.0
    take[o.at.held, :n] = o.reading
    into[o.at.held, :axes] = loop.optical.noise_rad * np.eye(axes)
    gauge = from_readings * np.concatenate([np.zeros(axes), np.full(outputs, gauge_noise_rad(loop))])
    fresh, held = (act @ take, act @ into + gauge), (act, gauge)
    samples = (fresh, *[held] * (loop.optical.every - 1))
    steps = []
    for A in o.steps:
        block = np.broadcast_to(np.eye(whole), (*A.shape[:-2], whole, whole)).copy()
        block[..., :n, :n] = A
        steps.append(block)
    sources = (
        *o.sources,
        Source("optical sensor noise", slice(0, axes), sampled=True),
        Source("gauge noise", slice(axes, readings), sampled=True),
    )
    return ClosedLoop(
        open=o,
        controller=c,
        samples=tuple(sample for sample, _ in samples),
        sample_noise=tuple(noise for _, noise in samples),
        steps=tuple(steps),
        step_noise=np.vstack([o.noise, np.zeros((s.order, o.noise.shape[1]))]),
        sources=sources,
    )


def gauge_noise_rad(loop: PointingLoop) -> float:
    """Noise of the strain gauge, none without one."""
    return 0.0 if loop.gauge is None else loop.gauge.noise_rad


def refuse_unstable(closed: ClosedLoop) -> None:
    """Raise ValueError when the loop is unstable.

    Raises:
        ValueError: The loop is unstable; gives its worst pole.
    """
    size, freq = closed.worst_pole()
    if size >= 1.0:
        raise ValueError(
            f"the loop under {closed.controller.name!r} is unstable: a pole at |z| = {size:.6f} (the limit is 1) and "
            f"{freq:.4g} Hz, for a control period of {closed.open.loop.timing.period_s:g} s; lower its gains or delay"
        )


@dataclass(frozen=True, slots=True)
class Stationary:
    """Stationary variances of a linear loop, averaged over the plant steps of a sensor period.

    ``error`` by axis (rad^2) and ``drive`` by actuator (V^2) are sums over the sources; ``error_by_source`` has a row
    (axes,) for each named source, those of one name on several axes together.
    """

    error: Floats
    drive: Floats
    error_by_source: dict[str, Floats]

    @property
    def radial_rms_rad(self) -> float:
        """Radial rms of the error."""
        return float(np.sqrt(np.sum(self.error)))


def stationary(closed: ClosedLoop) -> Stationary:
    """Stationary variances by the discrete Lyapunov equation (H2), one solution a source.

    Lines have no white source: what the loop makes of each is added, at a random phase.

    Raises:
        ValueError: The loop is unstable.
    """
    refuse_unstable(closed)
    o, axes = closed.open, closed.open.loop.axes
    monodromy = closed.monodromy
    by_name: dict[str, Floats] = {}
    drive = np.zeros(o.drive.shape[0])
    found = [(source.name, *_settled(closed, monodromy, noise_of(closed, source))[1:]) for source in closed.sources]
    found += [(line.name, *_line_variances(closed, monodromy, line)) for line in o.lines]
    for name, errors, drives in found:
        by_name[name] = by_name.get(name, np.zeros(axes)) + errors
        drive = drive + drives
    return Stationary(np.sum([np.zeros(axes), *by_name.values()], axis=0), drive, by_name)


Noise = tuple[tuple[Floats, ...], Floats]
"""What is added to the states, columns of unit white sequences: at each control sample and at each plant step."""


def noise_of(closed: ClosedLoop, source: Source) -> Noise:
    """What a source alone adds to the states: at each control sample of a sensor period, and at each plant step.

    Args:
        closed: The loop under its controller.
        source: One of its sources.
    """
    none = np.zeros((closed.step_noise.shape[0], 0))
    sampled = tuple(noise[..., source.columns] if source.sampled else none for noise in closed.sample_noise)
    return sampled, none if source.sampled else closed.step_noise[:, source.columns]


def noise_of_all(closed: ClosedLoop) -> Noise:
    """What all sources together add to the states, as `noise_of`; lines are no noise."""
    return closed.sample_noise, closed.step_noise


def start_of(closed: ClosedLoop, noise: Noise) -> tuple[Floats, Floats]:
    """Stationary covariance of the states before a sensor period, and variance of the error (rad^2), of a noise alone.

    The variance, per axis, is the mean over the plant steps of the period.

    Args:
        closed: The loop under its controller, stable.
        noise: What is added to its states, as `noise_of` has it.
    """
    P, errors, _ = _settled(closed, closed.monodromy, noise)
    return P, errors


def _settled(closed: ClosedLoop, monodromy: Floats, added: Noise) -> tuple[Floats, Floats, Floats]:
    """Covariance before a sensor period, and the mean variances of error and drive in it."""
    o, whole = closed.open, closed.step_noise.shape[0]
    sampled, stepped = added

    def over_period(P: Floats) -> tuple[Floats, Floats, Floats]:
        errors, drives, count = np.zeros(o.error.shape[0]), np.zeros(o.drive.shape[0]), 0
        for sample, noise in zip(closed.samples, sampled, strict=True):
            P = sample @ P @ sample.mT + noise @ noise.mT
            for step in closed.steps:
                P = step @ P @ step.mT + stepped @ stepped.T
                head = P[..., : o.at.order, : o.at.order]
                errors = errors + np.einsum("ij,...jk,ik->...i", o.error, head, o.error)
                drives = drives + np.einsum("ij,...jk,ik->...i", o.drive, head, o.drive)
                count += 1
        return P, errors / count, drives / count

    gathered, _, _ = over_period(np.zeros((whole, whole)))
    P = lti.gramian(monodromy.mT, gathered)
    return P, *over_period(P)[1:]


def _line_variances(closed: ClosedLoop, monodromy: Floats, line: Line) -> tuple[Floats, Floats]:
    """Variances that a line leaves, over its phase: half the squared size of what turns at each plant step."""
    states, _ = _turned(closed, monodromy, line)
    rows = (np.abs(states @ matrix.T) ** 2 for matrix in (closed.open.error, closed.open.drive))
    errors, drives = (np.asarray(0.5 * np.mean(each, axis=0)) for each in rows)
    return errors, drives


def turning(closed: ClosedLoop, line: Line) -> tuple[Complexes, complex]:
    """What a line leaves of the error at the plant steps of a sensor period (rad), and by what it turns in one.

    Args:
        closed: The loop under its controller, stable.
        line: One of its lines.

    Returns:
        Complex amplitudes, shape (plant steps, axes), and the factor from one sensor period to the next. Of a stack of
        loops the amplitudes have its axes behind that of the plant steps.
    """
    states, z = _turned(closed, closed.monodromy, line)
    return states @ closed.open.error.T, z


def _turned(closed: ClosedLoop, monodromy: Floats, line: Line) -> tuple[Complexes, complex]:
    """The turning state of the loop without controller at the plant steps of a sensor period, and its factor.

    Over a sensor period the line's states turn by a factor z on the unit circle, and so does the whole loop once it has
    settled: its turning state x is the eigenvector of the monodromy for z that has the line's own states in it.
    """
    o, keep = closed.open, _without_disturbances(closed)
    unit = np.array([1.0, 1.0j])
    own = monodromy.reshape(-1, *monodromy.shape[-2:])[0]  # a stack has the same disturbances in each loop
    z = complex((own[line.states, line.states] @ unit)[0])
    x = np.zeros((*monodromy.shape[:-1], 1), dtype=complex)
    x[..., line.states, 0] = line.amplitude_rad * unit
    moved = monodromy[..., keep, :]
    x[..., keep, :] = np.linalg.solve(z * np.eye(int(keep.sum())) - moved[..., keep], moved @ x)
    states = []
    for sample in closed.samples:
        x = sample @ x
        for step in closed.steps:
            x = step @ x
            states.append(x[..., : o.at.order, 0])
    return np.array(states), z


def sensitivity(closed: ClosedLoop, freq_hz: Floats) -> Complexes:
    """Error over disturbance at the control samples, shape (frequencies, axes, axes): the inverse of 1 + the loop gain.

    Args:
        closed: The loop under its controller.
        freq_hz: Frequencies up to half the control rate, shape (frequencies,).

    Raises:
        ValueError: The optical sensor is slower than the control, which folds frequencies.
    """
    return np.asarray(np.linalg.inv(np.eye(closed.open.loop.axes) + loop_response(closed, freq_hz)))


def loop_response(closed: ClosedLoop, freq_hz: Floats) -> Complexes:
    """Loop gain at the line of sight, shape (frequencies, axes, axes): error in, the mirror's angle out.

    Loops through the gauge are closed, and the optical sensor's delay is in it.

    Args:
        closed: The loop under its controller.
        freq_hz: Frequencies up to half the control rate, shape (frequencies,).

    Raises:
        ValueError: The optical sensor is slower than the control.
    """
    o, loop = closed.open, closed.open.loop
    if loop.optical.every != 1:
        raise ValueError(
            f"the optical sensor delivers every {loop.optical.every} control samples, and a response by frequency "
            "needs one reading a sample: give the controller the sensor's rate"
        )
    n, whole, axes = o.at.order, closed.step_noise.shape[0], loop.axes
    c = closed.controller.system
    # The optical reading becomes an input: drop it from the state's own map.
    into = np.zeros((whole, axes))
    into[o.newest], into[n:] = c.D[:, :axes], c.B[:, :axes]
    act = closed.samples[0].copy()
    reading = np.zeros((axes, whole))
    reading[:, :n] = o.reading
    act -= into @ reading
    act[o.at.held] = 0.0
    step_map = np.eye(whole)
    for step in closed.steps:
        step_map = step @ step_map
    keep = _without_disturbances(closed)
    A, B = (step_map @ act)[np.ix_(keep, keep)], (step_map @ into)[keep]
    system = lti.StateSpace(A, B, -reading[:, keep], np.zeros((axes, axes)))
    return lti.frequency_response(system, freq_hz, loop.timing.period_s)


def residual_spectrum(closed: ClosedLoop, freq_hz: Floats) -> Floats:
    """One-sided spectrum (rad^2/Hz) of the residual at the control samples, shape (frequencies, axes), lines left out.

    Args:
        closed: The loop under its controller.
        freq_hz: Frequencies up to half the control rate, shape (frequencies,).

    Raises:
        ValueError: The optical sensor is slower than the control.
    """
    o, loop = closed.open, closed.open.loop
    whole = closed.step_noise.shape[0]
    if loop.optical.every != 1:
        raise ValueError("a residual spectrum needs an optical reading at every control sample")
    monodromy = closed.monodromy
    reading = np.zeros((loop.axes, whole))
    reading[:, : o.at.order] = o.error
    keep = np.ones(whole, dtype=bool)
    for line in o.lines:
        keep[line.states] = False
    # From every state to the error, then the covariance: its factor would lose what is small in other units.
    points = np.exp(2j * math.pi * np.asarray(freq_hz) * loop.timing.period_s)
    rows = lti.resolvent_rows(monodromy[None][:, keep][:, :, keep], reading[None][:, :, keep], points)[0]
    added = _added_in_a_period(closed)[np.ix_(keep, keep)]
    power = np.sum((rows * (added @ rows.conj())).real, axis=1).T
    return np.asarray(2.0 * loop.timing.period_s * power)


def _added_in_a_period(closed: ClosedLoop) -> Floats:
    """Covariance that the noises of one control period add to the state at its end."""
    (sample_noise,) = closed.sample_noise
    P = sample_noise @ sample_noise.T
    for step in closed.steps:
        P = step @ P @ step.T + closed.step_noise @ closed.step_noise.T
    return P
