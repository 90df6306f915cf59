"""The worst that an identified mirror may make of a loop: over draws and over corners of its uncertainty."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from microrad.core.arrays import Floats
from microrad.core.progress import Progress
from microrad.loop.controller_study import Design, Scene, on_one_axis
from microrad.loop.coupled_study import CoupledDesign, CoupledScene
from microrad.loop.disturbance.windows import ErrorIndex
from microrad.loop.pointing_loop.linear import close, refuse_unstable
from microrad.loop.pointing_loop.loop import LoopController, PointingLoop
from microrad.loop.worst_case.batch import Figures, figures
from microrad.loop.worst_case.in_time import InTime, Simulated
from microrad.loop.worst_case.uncertain import Moved, Uncertain
from microrad.mirror.hysteresis import rest_gain, slow_gain

APE = ErrorIndex("APE")

MANY_STATES = 16
"""States of a mirror beyond which fewer mirrors are looked at: each takes up to 25 ms of a processor with 36 states."""

CLOSELY = 40
"""Parameters, at most, that are moved one by one; of more those that matter most to first order."""

UNBOUNDED = 1e6
"""Relative change that stands for one without bound."""

INDEPENDENT = 1e-3
"""Least part of a parameter's standard error that the more sensitive ones leave open, for a direction of its own."""


@dataclass(frozen=True, slots=True)
class Extent:
    """How far a worst case is looked for.

    ``draws`` mirrors are drawn. Corners are all combinations of signs of the ``most_sensitive`` parameters, each
    ``sigmas`` of its standard errors off.
    """

    draws: int = 1000
    most_sensitive: int = 10
    sigmas: float = 3.0

    @classmethod
    def for_states(cls, states: int) -> "Extent":
        """What some ten seconds are enough for: less for a mirror of many states."""
        return cls() if states <= MANY_STATES else cls(draws=200, most_sensitive=7)


@dataclass(frozen=True, slots=True)
class Sensitivity:
    """How much a parameter matters: largest relative changes by one standard error of it, up or down.

    The other parameters go along as their correlation says. ``rms`` has one change for each error index.
    """

    parameter: str
    rms: tuple[float, ...]
    modulus: float

    @property
    def largest(self) -> float:
        """The change of the figure that changes most."""
        return max(*self.rms, self.modulus)


@dataclass(frozen=True, slots=True)
class Worst:
    """A figure where it is worst: its value, and the parameters off their own, in standard errors, by name."""

    value: float
    sigmas: dict[str, float]


@dataclass(frozen=True, slots=True)
class Quantiles:
    """Of a figure over the draws: the median, and what 95 % of the draws are not worse than."""

    median: float
    worse: float


@dataclass(frozen=True, slots=True)
class WorstCase:
    """What an identified mirror may make of a loop under one controller, in linear theory.

    Rms of errors are radial, in rad, and by error index: ``nominal_rad`` on the mirror as it was identified,
    ``drawn_rad`` over the draws, ``largest_rad`` over draws and corners; infinite on a mirror on which the loop is
    unstable. The modulus margin, 0 there, has the fields of the same beginnings. ``corners`` were looked at, and
    ``corners_left_out`` are no mirrors. ``unstable_draws`` and ``unstable_corners`` count the mirrors on which the loop
    is unstable. ``verified_in_time`` simulates the mirror with the smallest margin, of unstable ones the one with the
    largest pole.
    """

    controller: str
    extent: Extent
    indices: tuple[ErrorIndex, ...]
    corners: int
    corners_left_out: int
    unstable_draws: int
    unstable_corners: int
    nominal_rad: tuple[float, ...]
    drawn_rad: tuple[Quantiles, ...]
    largest_rad: tuple[Worst, ...]
    nominal_modulus: float
    drawn_modulus: Quantiles
    smallest_modulus: Worst
    most_sensitive: tuple[Sensitivity, ...]
    verified_in_time: InTime


@dataclass(frozen=True, slots=True, eq=False)
class Subject:
    """A loop under a controller, and what is known of its mirror.

    ``theory`` is the loop that linear theory is of, and ``alike`` how many such loops there are side by side, each with
    the same mirror. ``simulated`` is the same in time.
    """

    theory: PointingLoop
    alike: int
    simulated: Simulated
    known: Uncertain

    @property
    def controller(self) -> LoopController:
        """The controller."""
        return self.simulated.controller

    def figures(self, mirrors: Sequence[Moved], indices: Sequence[ErrorIndex], threads: int | None) -> Figures:
        """The figures on some mirrors, the rms of all loops side by side."""
        gain = rest_gain if self.simulated.at_rest else slow_gain
        linear = [m.linear([gain(model) for model in m.bank]) for m, _ in mirrors]
        found = figures(self.theory, self.controller, linear, indices, threads)
        return replace(found, rms_rad=np.sqrt(self.alike) * found.rms_rad)


def of_scene(scene: Scene, known: Uncertain, design: Design) -> Subject:
    """A controller of a mission whose mirror stands on each axis: the drawn mirror is that of all its axes.

    The axes are alike and decoupled, so one of them tells of all.

    Args:
        scene: The mission's fine-pointing loop.
        known: What is known of its mirror, `of_table`.
        design: A controller that was designed for it.
    """
    simulated = Simulated(scene.axis, on_one_axis(design, scene), at_rest=False)
    return Subject(scene.axis, scene.loop.axes, simulated, known)


def of_coupled_scene(scene: CoupledScene, known: Uncertain, design: CoupledDesign) -> Subject:
    """A controller of a mission with a mirror of several axes, about rest.

    Args:
        scene: The mission's loop.
        known: What is known of its mirror, `of_several_axes`.
        design: A controller that was designed for it.
    """
    return Subject(scene.rest, 1, Simulated(scene.loop, design.controller, at_rest=True), known)


def worst_case(
    subject: Subject,
    seed: int,
    indices: Sequence[ErrorIndex] = (APE,),
    extent: Extent | None = None,
    threads: int | None = None,
    on_progress: Progress = lambda done, total, what: None,
) -> WorstCase:
    """Look for the worst over draws of an identified mirror, and over corners of what is known of it.

    Corners go along independent directions: the most sensitive parameter by its standard error with all others going
    along as their correlation says, then the next one by what the first leaves open of it, and so on. Without
    correlation these are the parameters themselves. Of a mirror of one axis no parameter of a corner falls below a
    tenth of its value.

    Args:
        subject: The loop, its controller and what is known of its mirror.
        seed: Seed of the draws; the first of them are those that designs with this seed have to hold for.
        indices: What counts of the error; APE is all of it.
        extent: How far it is looked for; by default what the mirror's states leave time for.
        threads: Threads to share the mirrors, by default one for each core; the result does not depend on them.
        on_progress: Called with the steps that are done, their number and the one at hand.

    Raises:
        ValueError: The loop is unstable on the mirror as it was identified, a time of an index is below half of the
            time between two readings, or the uncertainty leaves no mirror.
    """
    known, extent = subject.known, extent or Extent.for_states(len(subject.theory.mirror.A))

    def step(done: int, what: str) -> None:
        on_progress(done, 4, what)

    refuse_unstable(close(subject.theory, subject.controller))
    step(0, "sensitivity of the parameters")
    own = known.moved(np.zeros(known.rows.shape[1]))
    assert own is not None
    nominal, ranked = _ranked(subject, own, indices, threads)
    chosen = ranked[: extent.most_sensitive]
    step(1, f"{extent.draws} mirrors drawn")
    draws = known.drawn(extent.draws, seed)
    drawn = subject.figures(draws, indices, threads)
    step(2, "corners")
    order = [known.parameters.index(each.parameter) for each in ranked]
    across = _independent(known.rows, order, extent.most_sensitive)
    places = [extent.sigmas * np.array(signs) @ across for signs in product((1.0, -1.0), repeat=len(across))]
    corners = [each for each in map(known.moved, places) if each is not None]
    cornered = subject.figures(corners, indices, threads)
    step(3, "worst case in time")
    every = [own, *draws, *corners]
    rms = np.concatenate([nominal.rms_rad[:1], drawn.rms_rad, cornered.rms_rad])
    modulus = np.concatenate([nominal.modulus[:1], drawn.modulus, cornered.modulus])
    poles = np.concatenate([nominal.pole[:1], drawn.pole, cornered.pole])
    weakest = int(np.lexsort((-poles, modulus))[0])
    # of mirrors on which the error has no bound, the one with the largest pole
    largest = [int(np.lexsort((-poles, -rms[:, i]))[0]) for i in range(len(indices))]

    def worst(values: Floats, at: int) -> Worst:
        return Worst(float(values[at]), dict(zip(known.parameters, every[at].sigmas.tolist(), strict=True)))

    return WorstCase(
        controller=subject.controller.name,
        extent=extent,
        indices=tuple(indices),
        corners=len(corners),
        corners_left_out=len(places) - len(corners),
        unstable_draws=drawn.unstable,
        unstable_corners=cornered.unstable,
        nominal_rad=tuple(nominal.rms_rad[0].tolist()),
        drawn_rad=tuple(_quantiles(values, 0.95) for values in drawn.rms_rad.T),
        largest_rad=tuple(worst(rms[:, i], at) for i, at in enumerate(largest)),
        nominal_modulus=float(nominal.modulus[0]),
        drawn_modulus=_quantiles(drawn.modulus, 0.05),
        smallest_modulus=worst(modulus, weakest),
        most_sensitive=tuple(chosen),
        verified_in_time=subject.simulated.on(every[weakest].mirror, float(poles[weakest])),
    )


def _quantiles(values: Floats, worse: float) -> Quantiles:
    """Median and a quantile, each of them the value of a draw: between two draws one may be infinite."""
    median, far = np.quantile(values, (0.5, worse), method="inverted_cdf").tolist()
    return Quantiles(median, far)


def _ranked(
    subject: Subject, own: Moved, indices: Sequence[ErrorIndex], threads: int | None
) -> tuple[Figures, list[Sensitivity]]:
    """Figures of the mirror as it is, first of those of mirrors moved by one parameter, and how much each matters."""
    known = subject.known
    many = len(known.parameters) > CLOSELY
    looked_at = _likely(subject, own, indices, threads) if many else [*range(len(known.parameters))]
    moved = [(number, known.moved(sign * known.rows[number])) for number in looked_at for sign in (1.0, -1.0)]
    there = [(number, each) for number, each in moved if each is not None]
    found = subject.figures([own, *(each for _, each in there)], indices, threads)
    changes, numbers = _changes(found), np.array([number for number, _ in there])
    largest = {i: np.max(changes[numbers == i], axis=0, initial=0.0).tolist() for i in looked_at}
    each = [Sensitivity(known.parameters[i], tuple(rms), modulus) for i, (*rms, modulus) in largest.items()]
    return found, sorted(each, key=lambda one: -one.largest)


def _changes(found: Figures) -> Floats:
    """Sizes of the relative changes of all figures from those of the first mirror, one row for each of the others."""
    values = np.column_stack([found.rms_rad, found.modulus])
    return np.asarray(np.abs(values[1:] / values[0] - 1.0))


def _likely(subject: Subject, own: Moved, indices: Sequence[ErrorIndex], threads: int | None) -> list[int]:
    """The parameters that matter most to first order, by the slopes along the independent directions; rising."""
    rows = subject.known.rows
    moved = [subject.known.moved(sign * each) for each in np.eye(rows.shape[1]) for sign in (1.0, -1.0)]
    found = subject.figures([own, *(each or own for each in moved)], indices, threads)
    values = np.column_stack([found.rms_rad, found.modulus])
    slopes = 0.5 * (values[1::2] - values[2::2]) / values[0]
    matters = np.max(np.abs(rows @ np.where(np.isfinite(slopes), slopes, UNBOUNDED)), axis=1)
    return sorted(map(int, np.argsort(-matters, kind="stable")[:CLOSELY]))


def _independent(rows: Floats, order: Sequence[int], most: int) -> Floats:
    """Directions of length 1 (directions, numbers), each with what the ones before leave of a parameter's own."""
    found: list[Floats] = []
    for number in order:
        left = rows[number].copy()
        for _ in range(2):  # the second time takes off what rounding left of the first
            for each in found:
                left -= (left @ each) * each
        size = float(np.linalg.norm(left))
        if size > INDEPENDENT and len(found) < most:
            found.append(left / size)
    return np.array(found).reshape(len(found), rows.shape[1])
