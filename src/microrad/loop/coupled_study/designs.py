"""Controllers for a mirror of several axes: decoupled, one loop an axis, judged all together on the whole mirror."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from microrad.core.arrays import Complexes, Floats
from microrad.core.progress import Progress
from microrad.loop.control import DesignPlant, MultiloopMargin, Tuned, multiloop_disk_margin
from microrad.loop.control.analysis import resolving
from microrad.loop.controller_study import designs as one_axis
from microrad.loop.controller_study.results import Outlook, shortened
from microrad.loop.coupled_study.scene import AXES, CoupledScene
from microrad.loop.pointing_loop.design import design_plant
from microrad.loop.pointing_loop.linear import ClosedLoop, close, loop_response, stationary
from microrad.loop.pointing_loop.loop import LoopController, assemble, axis_of, decoupling
from microrad.mission.tables.fine_pointing import FinePointing

TRIES = 4
"""Times that the axes are tuned, each time for a larger margin of their own, until the whole keeps the mission's."""

HEADROOM = 1.05
"""What a margin of an axis is raised by beyond what was missed of the whole."""


@dataclass(frozen=True, slots=True, eq=False)
class CoupledDesign:
    """One controller of all axes: how each axis was tuned, and what the whole loop has of it.

    ``modulus`` is the least singular value of 1 + L, the loop gain at the line of sight with both axes closed, over all
    frequencies and linear loops of the scene, and ``margin`` the smallest disk margin against changes of both loops at
    once. ``residual_rad`` is the rms of each axis for small motions about rest, linear, and ``worst_rad`` the largest
    of each axis over all linear loops.
    """

    name: str
    tuned: tuple[Tuned, ...]
    controller: LoopController
    modulus: float
    margin: MultiloopMargin
    residual_rad: Floats
    worst_rad: Floats


def names(f: FinePointing) -> tuple[str, ...]:
    """The controllers that are designed for a mirror of several axes."""
    return tuple(family.name for family in one_axis.families(f))


def plants(scene: CoupledScene) -> tuple[tuple[DesignPlant, ...], ...]:
    """By axis, what its controller is designed for: the axis in each linear loop of the scene, decoupled as at rest."""
    to_drives = decoupling(scene.rest)
    return tuple(
        tuple(design_plant(axis_of(loop, axis, to_drives)) for loop in scene.linear) for axis in range(scene.loop.axes)
    )


def design(
    scene: CoupledScene, on_progress: Progress = lambda done, total, what: None, only: Sequence[str] = ()
) -> tuple[CoupledDesign, ...]:
    """Design controllers: one of each family an axis, tuned until all of them together keep the modulus margin.

    Args:
        scene: The mission's loop.
        on_progress: Called with the controllers that are designed, their number and what is done.
        only: Names out of `names`, in the order that is wanted; by default all.

    Raises:
        ValueError: For a name that `names` does not list, and where a controller cannot meet its margin; says why.
    """
    wanted, of = tuple(only) or names(scene.table), plants(scene)
    asked = dict.fromkeys(wanted, scene.table.modulus_margin)
    found: dict[str, CoupledDesign] = {}
    for _ in range(TRIES):
        tuned = _tuned(scene.table, asked, of, on_progress)
        for name in [*asked]:
            found[name] = _judged(scene, name, [each[name] for each in tuned])
            if found[name].modulus >= scene.table.modulus_margin:
                del asked[name]
            else:
                asked[name] *= HEADROOM * scene.table.modulus_margin / max(found[name].modulus, 0.5 * asked[name])
        if not asked:
            return tuple(found[name] for name in wanted)
    missed = next(iter(asked))
    raise ValueError(
        f"{missed}, tuned for each axis by itself, keeps a modulus margin of {found[missed].modulus:.3g} with all axes "
        f"closed, where {scene.table.modulus_margin:g} is asked for: the axes pull on each other too much; lower "
        "fine_pointing.modulus_margin, or leave this controller out"
    )


def _tuned(
    f: FinePointing,
    asked: Mapping[str, float],
    of: Sequence[Sequence[DesignPlant]],
    on_progress: Progress,
) -> list[Mapping[str, Tuned]]:
    """By axis, the controllers tuned for the modulus margin that is asked of each."""
    found: list[Mapping[str, Tuned]] = []
    for number, axis in enumerate(of):
        tuned: dict[str, Tuned] = {}
        for margin in dict.fromkeys(asked.values()):
            some = [name for name in asked if asked[name] == margin]

            before = number * len(asked) + len(tuned)
            told = partial(_told, on_progress, before, len(of) * len(asked), f"axis {AXES[number]}")
            tuned |= one_axis.tune_all(some, f.model_copy(update={"modulus_margin": margin}), axis, told)
        found.append(tuned)
    return found


def _told(on_progress: Progress, before: int, of: int, where: str, done: int, total: int, what: str) -> None:
    del total
    on_progress(before + done, of, f"{where}, {what}")


def _judged(scene: CoupledScene, name: str, tuned: Sequence[Tuned]) -> CoupledDesign:
    """The controllers of all axes as one, with the worst of its linear loops; no margin where one is unstable."""
    controller = assemble(name, scene.rest, [each.controller for each in tuned])
    closed = [close(loop, controller) for loop in scene.linear]
    if max(each.worst_pole()[0] for each in closed) >= 1.0:
        nothing = np.full(scene.loop.axes, np.inf)
        return CoupledDesign(name, tuple(tuned), controller, 0.0, MultiloopMargin(0.0, 0.0), nothing, nothing)
    gains = [_loop_gain(each) for each in closed]
    moduli = (np.linalg.svd(np.eye(scene.loop.axes) + L, compute_uv=False)[:, -1] for _, L in gains)
    left = np.array([np.sqrt(stationary(each).error) for each in closed])
    return CoupledDesign(
        name,
        tuple(tuned),
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
