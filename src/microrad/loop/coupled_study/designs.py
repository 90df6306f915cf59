"""Controllers for a mirror of several axes: decoupled, one loop an axis, judged all together on the whole mirror."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import NamedTuple

import numpy as np

from microrad.core import lti
from microrad.core.arrays import Complexes, Floats
from microrad.core.progress import Progress
from microrad.core.threads import shared_out
from microrad.loop.control import (
    LQG,
    Family,
    MultiloopMargin,
    Specification,
    Tuned,
    WholePlant,
    multiloop_disk_margin,
    tune,
)
from microrad.loop.control.analysis import resolving
from microrad.loop.controller_study import designs as one_axis
from microrad.loop.controller_study.results import Outlook, shortened
from microrad.loop.coupled_study.scene import CoupledScene
from microrad.loop.coupled_study.whole import lqg_for, with_others_closed
from microrad.loop.pointing_loop.design import whole_plant
from microrad.loop.pointing_loop.linear import ClosedLoop, close, loop_response, stationary
from microrad.loop.pointing_loop.loop import LoopController, assemble, assemble_whole, decoupling
from microrad.mission.tables.fine_pointing import FinePointing

ROUNDS = 6
"""Times that all axes are tuned in turn, until the whole keeps the mission's margin."""

HEADROOM, MOST = 1.05, 0.9
"""What a margin of an axis is raised by beyond what was missed of the whole, and its largest."""


@dataclass(frozen=True, slots=True, eq=False)
class CoupledDesign:
    """One controller of all axes, and what the whole loop has of it.

    ``tuned`` are the values that it was tuned to: by axis, or those of all axes at once. ``modulus`` is the least singular value of 1 + L, the loop gain at the line of sight with both axes closed, over all
    frequencies and linear loops of the scene, and ``margin`` the smallest disk margin against changes of both loops at
    once. ``residual_rad`` is the rms of each axis for small motions about rest, linear, and ``worst_rad`` the largest
    of each axis over all linear loops.
    """

    name: str
    tuned: tuple[Mapping[str, float], ...]
    controller: LoopController
    modulus: float
    margin: MultiloopMargin
    residual_rad: Floats
    worst_rad: Floats

    @property
    def total_rad(self) -> float:
        """Radial rms for small motions about rest, linear."""
        return float(np.linalg.norm(self.residual_rad))


class CoupledDesigns(NamedTuple):
    """The controllers that were designed, and why others could not be, by name."""

    made: tuple[CoupledDesign, ...]
    refused: Mapping[str, str]


def names(f: FinePointing) -> tuple[str, ...]:
    """The controllers that are designed for a mirror of several axes."""
    return tuple(family.name for family in one_axis.families(f))


def plants(scene: CoupledScene) -> tuple[WholePlant, ...]:
    """What controllers are designed for: all axes in each linear loop of the scene, decoupled as at rest."""
    to_drives = decoupling(scene.rest)
    return tuple(whole_plant(loop, to_drives) for loop in scene.linear)


def design(
    scene: CoupledScene, on_progress: Progress = lambda done, total, what: None, only: Sequence[str] = ()
) -> CoupledDesigns:
    """Design controllers that keep the modulus margin with all axes closed.

    LQG is one controller of all axes. Of the other families each axis has one: they are tuned in turn, each with those
    of the other axes at work, and for a larger margin of its own where the whole lacks some. No family is worse than
    the one that it contains.

    Args:
        scene: The mission's loop.
        on_progress: Called with the controllers that are designed, their number and what is done.
        only: Names out of `names`, in the order that is wanted; by default all.

    Raises:
        ValueError: For a name that `names` does not list, and where no controller meets its margin; says why.
    """
    import scipy.optimize  # noqa: F401  slow to import: once, ahead of the other process

    has = names(scene.table)
    wanted = tuple(only) or has
    for name in wanted:
        if name not in has:
            raise ValueError(f"{name!r} is no controller of a mirror of several axes; there are {', '.join(has)}")
    of, families = plants(scene), {family.name: family for family in one_axis.families(scene.table)}
    order = sorted(wanted, key=lambda name: name != LQG.name)
    jobs = [partial(_designed_or_why, scene, families[name], of) for name in order]
    with shared_out(jobs, lambda turn: on_progress(turn, len(order), f"tuning {order[turn]}")) as results:
        found = dict(zip(order, results(), strict=True))
    on_progress(len(order), len(order), "controllers tuned")
    made = {name: each for name, each in found.items() if isinstance(each, CoupledDesign)}
    if not made:
        raise ValueError("; ".join(str(found[name]) for name in wanted))
    for name, own in made.items():
        inner = families[name].base
        base = made.get(inner.name) if inner else None
        if base is not None and base.total_rad < own.total_rad:
            made[name] = replace(base, name=name, controller=replace(base.controller, name=name))
    return CoupledDesigns(
        tuple(made[name] for name in wanted if name in made),
        {name: str(found[name]) for name in wanted if name not in made},
    )


def _designed_or_why(scene: CoupledScene, family: Family, of: Sequence[WholePlant]) -> CoupledDesign | str:
    try:
        return (_all_at_once if family is LQG else _in_turn)(scene, family, of)
    except ValueError as error:
        return str(error)


def _all_at_once(scene: CoupledScene, family: Family, of: Sequence[WholePlant]) -> CoupledDesign:
    system, windup, values = lqg_for(of, scene.table.modulus_margin)
    found = _judged(scene, assemble_whole(family.name, scene.rest, system, windup), (values,))
    _refuse_missed(scene, found)
    return found


def _in_turn(scene: CoupledScene, family: Family, of: Sequence[WholePlant]) -> CoupledDesign:
    """One controller an axis, tuned in turn with the others at work."""
    axes = range(scene.loop.axes)
    margin = scene.table.modulus_margin
    controllers: list[lti.StateSpace | None] = [None for _ in axes]
    tuned: dict[int, Tuned] = {}
    best: CoupledDesign | None = None
    for _ in range(ROUNDS):
        for axis in axes:
            others = [with_others_closed(plant, axis, controllers) for plant in of]
            tuned[axis] = tune(family, others, Specification(margin), seed=scene.table.seed)
            s = tuned[axis].controller.system
            controllers[axis] = lti.StateSpace(s.A, s.B[:, :1], s.C, s.D[:, :1])
        made = assemble(family.name, scene.rest, [tuned[axis].controller for axis in axes])
        found = _judged(scene, made, tuple(tuned[axis].values for axis in axes))
        best = found if best is None or found.modulus > best.modulus else best
        if found.modulus >= scene.table.modulus_margin:
            return found
        short = scene.table.modulus_margin / max(found.modulus, 0.5 * scene.table.modulus_margin)
        margin = min(HEADROOM * margin * short, MOST)
    assert best is not None
    _refuse_missed(scene, best)
    return best


def _refuse_missed(scene: CoupledScene, found: CoupledDesign) -> None:
    asked = scene.table.modulus_margin
    if found.modulus < asked:
        raise ValueError(
            f"{found.name} keeps a modulus margin of {found.modulus:.3g} with all axes closed, where {asked:g} is "
            "asked for: the axes pull on each other too much; lower fine_pointing.modulus_margin, or take another "
            "controller"
        )


def _judged(scene: CoupledScene, controller: LoopController, values: tuple[Mapping[str, float], ...]) -> CoupledDesign:
    """A controller with the worst of the linear loops under it; no margin where one is unstable."""
    closed = [close(loop, controller) for loop in scene.linear]
    if max(each.worst_pole()[0] for each in closed) >= 1.0:
        nothing = np.full(scene.loop.axes, np.inf)
        return CoupledDesign(controller.name, values, controller, 0.0, MultiloopMargin(0.0, 0.0), nothing, nothing)
    gains = [_loop_gain(each) for each in closed]
    moduli = (np.linalg.svd(np.eye(scene.loop.axes) + L, compute_uv=False)[:, -1] for _, L in gains)
    left = np.array([np.sqrt(stationary(each).error) for each in closed])
    return CoupledDesign(
        controller.name,
        values,
        controller,
        min(float(np.min(each)) for each in moduli),
        min((multiloop_disk_margin(*each) for each in gains), key=lambda margin: margin.disk),
        left[0],
        np.max(left, axis=0),
    )


def _loop_gain(closed: ClosedLoop) -> tuple[Floats, Complexes]:
    """Frequencies that show every resonance, open and closed, and the loop gain at the line of sight there."""
    period, whole = closed.open.loop.timing.period_s, np.asarray(closed.open.shift)
    for step in closed.open.steps:
        whole = step @ whole
    maps = whole, closed.controller.system.A, closed.monodromy
    freq = resolving(np.concatenate([np.linalg.eigvals(each) for each in maps]), period)
    return freq, loop_response(closed, freq)


def outlook(
    scene: CoupledScene, designs: Sequence[CoupledDesign], on_progress: Progress = lambda done, total, what: None
) -> tuple[tuple[Outlook, ...], ...]:
    """By design and axis, the linear figure about rest beside one simulated on the mirror with its hysteresis.

    Args:
        scene: The mission's loop.
        designs: The designs, in the order that is wanted.
        on_progress: Called with the parts of the work that are done, their number and what is done.
    """
    found = shortened(scene.table, scene.loop, [d.controller for d in designs], on_progress)
    return tuple(
        tuple(map(Outlook, d.residual_rad.tolist(), each.axis_rms_rad.tolist()))
        for d, each in zip(designs, found, strict=True)
    )
