"""Controllers for a mirror of several axes: decoupled, one loop an axis, judged all together on the whole mirror."""

import math
from collections import ChainMap
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import product
from typing import NamedTuple

import numpy as np

from microrad.core.arrays import Floats
from microrad.core.progress import Progress
from microrad.core.threads import shared_out
from microrad.loop import control
from microrad.loop.control import (
    H_INFINITY_OF_AXES,
    LQG,
    LQG_OF_AXES,
    PI,
    Family,
    LoopMargins,
    MultiloopMargin,
    Specification,
    Weights,
    WholeController,
    WholePlant,
    lqg_of_axes,
)
from microrad.loop.control.descent import descend
from microrad.loop.control.search import Search, Trial, apart
from microrad.loop.control.tuning import MARGIN, settled
from microrad.loop.controller_study import FinePointingStudy, simulated
from microrad.loop.controller_study import designs as one_axis
from microrad.loop.controller_study.promises import firmer
from microrad.loop.controller_study.results import Outlook, shortened
from microrad.loop.controller_study.scenario import references
from microrad.loop.coupled_study.directions import ALONG_AXES, along, loop_directions, on_axes
from microrad.loop.coupled_study.scene import AXES, CoupledScene
from microrad.loop.coupled_study.whole import ALL_AXES, WholeMargins, alone, side_by_side, whole_margins
from microrad.loop.pointing_loop.design import whole_plant
from microrad.loop.pointing_loop.feedforward import with_feedforward
from microrad.loop.pointing_loop.linear import close, stationary
from microrad.loop.pointing_loop.loop import LoopController, ReferenceFilter, assemble_whole, decoupling
from microrad.mission.tables.fine_pointing import FinePointing

WITH_FEEDFORWARD = f"{PI.name} + feedforward"
"""The PI with the mirror's hysteresis run forward on the reference: the same feedback, and so the same margins."""

OF_AXES = (LQG_OF_AXES, H_INFINITY_OF_AXES)
"""Kinds of controllers that are one of all axes; of the others each axis has its own."""

STARTS = 3
"""Places from which the weights of such a controller are followed."""

MODELS = 8
"""Quadratic models of the whole that its weights are followed by."""

NOMINAL = 2
"""Plants that controllers are tuned for: at rest and over the whole range. The others have to keep the margin, too."""

DIRECTION = "direction {} in rad"
"""Value of a design with loops along other directions than the axes: angle from x towards y, by loop."""

LOOKS, ENOUGH = 8, 0.01
"""Margins that controllers are tuned for until the whole keeps the one asked for, and what it may have to spare."""

LEAST_RAISE, DECIMALS = 2e-3, 3
"""By how much that margin is raised at least, and the decimals that it has."""

AT_BOUND = 0.02
"""Share of the margin asked for above which a design is not bound by it."""

SURVEY = 40
"""Places that the search of an axis by itself begins with."""


@dataclass(frozen=True, slots=True, eq=False)
class CoupledDesign:
    """One controller of all axes, and what the whole loop has of it.

    ``tuned`` are the values that it was tuned to, by name. ``margins`` are the smallest over all linear loops of the
    scene, each with all axes closed. ``residual_rad`` is the rms of each axis for small motions about rest, linear, and
    ``drive_v`` that of each drive. ``margin`` is the modulus margin that it was tuned for where the mirror's hysteresis
    asks for more than the mission's, else None. ``bound_by`` names that margin where the tuning ended at it.
    """

    name: str
    tuned: Mapping[str, float]
    controller: LoopController
    margins: WholeMargins
    residual_rad: Floats
    drive_v: Floats
    margin: float | None = None
    inverse: str = ""
    bound_by: tuple[str, ...] = ()

    @property
    def values(self) -> Mapping[str, float]:
        """What it was tuned to, by name, in SI units."""
        return self.tuned

    @property
    def loop_margins(self) -> LoopMargins:
        """Those of the whole; gain and phase are what the disk margin promises for both loops at once."""
        disk, modulus = self.margins.disk, self.margins.modulus
        lowest, highest = disk.disk_gain
        return LoopMargins(
            disk=disk.disk,
            gain_up=highest,
            gain_down=lowest,
            phase_rad=disk.disk_phase_rad,
            delay_s=math.nan,
            modulus=modulus,
            crossover_hz=math.nan,
            bandwidth_hz=self.margins.bandwidth_hz,
            peak=1.0 / modulus,
            peak_hz=math.nan,
        )


@dataclass(frozen=True, slots=True)
class CoupledOutlook:
    """By axis, the linear figure about rest beside one simulated on the mirror with its hysteresis."""

    axes: tuple[Outlook, ...]

    @property
    def simulated_rad(self) -> float:
        """Simulated radial rms."""
        return math.hypot(*(axis.simulated_rad for axis in self.axes))

    @property
    def worst(self) -> Outlook:
        """That of the axis on which the simulation strays farthest."""
        return max(self.axes, key=lambda axis: axis.times)

    @property
    def holds(self) -> bool:
        """Whether the linear figure of each axis is a promise."""
        return self.worst.holds


class CoupledDesigns(NamedTuple):
    """The controllers that were designed, and why others could not be, by name."""

    made: tuple[CoupledDesign, ...]
    refused: Mapping[str, str]


def families(f: FinePointing) -> tuple[Family, ...]:
    """Kinds of controller for a mirror of several axes: those of one axis that fit the loop, and those of all at once.

    Args:
        f: The mission's fine-pointing table.
    """
    of_one = [LQG_OF_AXES if family is LQG else family for family in one_axis.families(f)]
    return (*of_one, H_INFINITY_OF_AXES)


def names(f: FinePointing) -> tuple[str, ...]:
    """The controllers that are designed for a mirror of several axes; a feedforward where a reference is known."""
    known = any(each.point_ahead_rad or each.line_of_sight_rate_rad_s for each in references(f))
    found = [family.name for family in families(f)]
    return tuple(
        each for name in found for each in ((name, WITH_FEEDFORWARD) if name == PI.name and known else (name,))
    )


def plants(scene: CoupledScene) -> tuple[WholePlant, ...]:
    """What controllers are designed for: all axes in each linear loop of the scene, decoupled as at rest."""
    to_drives = decoupling(scene.rest)
    return tuple(whole_plant(loop, to_drives) for loop in scene.linear)


def design(
    scene: CoupledScene, on_progress: Progress = lambda done, total, what: None, only: Sequence[str] = ()
) -> CoupledDesigns:
    """Design controllers that keep the modulus margin with all axes closed.

    LQG and H-infinity are one controller of all axes. Of the other families each axis has one, tuned while the other
    rests, for the least margin at which the whole keeps the one that is asked for; a family is never worse than one
    that it contains. These loops go along the axes, or along the modes' `directions` where those pull on each other
    less.

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
    of, kinds = plants(scene), {family.name: family for family in families(scene.table)}
    tuned = [*dict.fromkeys(feedback_of(name) for name in wanted)]
    turns = [[name for name in tuned if kinds[name].base or kinds[name] is PI], *([n] for n in tuned)]
    turns = [turn for i, turn in enumerate(turns) if turn and (i == 0 or not {*turn} & {*turns[0]})]
    jobs = [partial(_designed_in_turn, scene, [kinds[name] for name in turn], of) for turn in turns]
    with shared_out(jobs, lambda i: on_progress(i, len(turns), f"tuning {turns[i][0]}")) as results:
        found: ChainMap[str, CoupledDesign | str] = ChainMap(*results())
    on_progress(len(turns), len(turns), "controllers tuned")
    done = {name: found[feedback_of(name)] for name in wanted}
    made = {name: _as_named(scene, name, each) for name, each in done.items() if isinstance(each, CoupledDesign)}
    if not made:
        raise ValueError("; ".join(str(each) for each in done.values()))
    return CoupledDesigns(tuple(made.values()), {name: str(each) for name, each in done.items() if name not in made})


def feedback_of(name: str) -> str:
    """The controller whose feedback one of `names` has."""
    return PI.name if name == WITH_FEEDFORWARD else name


def as_named(scene: CoupledScene, name: str, feedback: LoopController) -> LoopController:
    """A feedback, with the feedforward where the name says so.

    Args:
        scene: The mission's loop.
        name: One of `names`.
        feedback: The controller that is called `feedback_of` that name.
    """
    if name != WITH_FEEDFORWARD:
        return feedback
    return with_feedforward(name, scene.loop, feedback, ReferenceFilter(scene.table.reference_filter_hz))


def _as_named(scene: CoupledScene, name: str, design: CoupledDesign) -> CoupledDesign:
    return replace(design, name=name, controller=as_named(scene, name, design.controller))


def design_and_simulate(
    scene: CoupledScene, on_progress: Progress = lambda done, total, what: None
) -> FinePointingStudy:
    """Design and simulate controllers, as `controller_study.design_and_simulate`; PI is what others are held against.

    Args:
        scene: The mission's loop.
        on_progress: Called with what is done of the step at hand, of how much, and the step in words.

    Raises:
        ValueError: No controller meets its margin; says why.
    """
    return simulated(scene, design(scene, on_progress).made, optimum_rms_rad(scene), on_progress)


def optimum_rms_rad(scene: CoupledScene) -> float:
    """Radial rms about rest under the controller that leaves least of all linear ones: LQG without any other price.

    Args:
        scene: The mission's loop.
    """
    free = Weights(command=1e-6, sensor_noise=1.0, command_noise_v=0.0)
    best = lqg_of_axes(whole_plant(scene.rest, decoupling(scene.rest)), free)
    return stationary(
        close(scene.rest, assemble_whole(best.name, scene.rest, best.system, best.anti_windup))
    ).radial_rms_rad


def design_and_promise(
    scene: CoupledScene, on_progress: Progress = lambda done, total, what: None, only: Sequence[str] = ()
) -> tuple[CoupledDesigns, tuple[CoupledOutlook, ...]]:
    """As `design`, each with what it leaves; tuned for a larger margin where its linear figure is no promise.

    Args:
        scene: The mission's loop.
        on_progress: Called with the controllers that are designed, their number and what is done.
        only: Names out of `names`, in the order that is wanted; by default all.

    Raises:
        ValueError: For a name that `names` does not list, and where no controller meets its margin; says why.
    """
    found = design(scene, on_progress, only)
    kept = [
        (d, figure) if figure.holds else _firmer(scene, d, on_progress) or (d, figure)
        for d, figure in zip(found.made, outlook(scene, found.made, on_progress), strict=True)
    ]
    return CoupledDesigns(tuple(d for d, _ in kept), found.refused), tuple(figure for _, figure in kept)


def _firmer(
    scene: CoupledScene, broken: CoupledDesign, on_progress: Progress
) -> tuple[CoupledDesign, CoupledOutlook] | None:
    (family,) = (each for each in families(scene.table) if each.name == feedback_of(broken.name))

    def tuned(margin: float) -> CoupledDesign:
        on_progress(0, 1, f"tuning {broken.name} for a larger margin")
        table = scene.table.model_copy(update={"modulus_margin": margin})
        made = _designed(replace(scene, table=table), family, plants(scene), None)
        return replace(_as_named(scene, broken.name, made), margin=margin)

    return firmer(scene.table.modulus_margin, tuned, lambda designs: outlook(scene, designs))


def _designed_in_turn(
    scene: CoupledScene, families: Sequence[Family], of: Sequence[WholePlant]
) -> dict[str, CoupledDesign | str]:
    """The controller of each family, or why there is none; a base comes before what contains it, and is done once."""
    found: dict[str, CoupledDesign | str] = {}
    for family in sorted(families, key=lambda each: each.base is not None):
        base = family.base and found.get(family.base.name)
        try:
            found[family.name] = _designed(scene, family, of, base if isinstance(base, CoupledDesign) else None)
        except ValueError as error:
            found[family.name] = str(error)
    return found


def _designed(
    scene: CoupledScene, family: Family, of: Sequence[WholePlant], base: CoupledDesign | None
) -> CoupledDesign:
    """The controller of a family that keeps its margin on all plants, with all axes closed.

    It is tuned for the least margin at which the whole keeps the one that is asked for: what it is tuned for knows
    nothing of the other axes, or of the mirrors that are drawn.
    """
    asked, low, high = scene.table.modulus_margin, (0.0, 0.0), (math.inf, math.inf)  # tuned for, and what the whole has
    tuned_for, found, refused = asked, None, ""
    for _ in range(LOOKS):
        try:
            made, values = _tuned(scene, family, of[:NOMINAL], tuned_for)
            margins = [_margins(plant, made) for plant in of]
            least = min(each.modulus for each in margins)
        except ValueError as error:  # beyond what the family can have
            refused, least = refused or str(error), math.inf
        if asked <= least < math.inf:
            found = made, values, margins
            if tuned_for == asked or least <= (1.0 + ENOUGH) * asked:
                break
        low, high = ((tuned_for, least), high) if least < asked else (low, (tuned_for, least))
        following = round(_between(asked, low, high), DECIMALS)
        if following in (low[0], high[0]):
            break
        tuned_for = following
    if found is None:
        raise ValueError(_out_of_reach(family.name, asked, low[1], len(of)) if low[0] else refused)
    design = _of(scene, family.name, *found)
    if base is not None and np.linalg.norm(base.residual_rad) < np.linalg.norm(design.residual_rad):
        return replace(base, name=family.name, controller=replace(base.controller, name=family.name))
    return design


def _between(asked: float, low: tuple[float, float], high: tuple[float, float]) -> float:
    """The margin to tune for next: the whole has less than is asked for at the low one, and enough at the high one."""
    if math.isinf(high[0]):
        return low[0] + max(asked - low[1], LEAST_RAISE)
    if math.isinf(high[1]):
        return 0.5 * (low[0] + high[0])
    aim = (1.0 + 0.5 * ENOUGH) * asked
    return low[0] + (high[0] - low[0]) * (aim - low[1]) / (high[1] - low[1])


def _out_of_reach(name: str, asked: float, reached: float, mirrors: int) -> str:
    return (
        f"{name} keeps a modulus margin of {reached:.3g} with all axes closed, on the worst of {mirrors} linear "
        "mirrors (about rest, over the whole drive range, drawn from the identification), where "
        f"{asked:g} is asked for; identify it from more records, lower fine_pointing.modulus_margin, or take another "
        "controller"
    )


def _of(
    scene: CoupledScene, name: str, made: WholeController, values: dict[str, float], margins: Sequence[WholeMargins]
) -> CoupledDesign:
    on_drives = assemble_whole(name, scene.rest, made.system, made.anti_windup)
    left = stationary(close(scene.rest, on_drives))
    smallest = WholeMargins(
        min(each.modulus for each in margins),
        min((each.disk for each in margins), key=lambda margin: margin.disk),
        min(each.bandwidth_hz for each in margins),
    )
    return CoupledDesign(
        name,
        values,
        on_drives,
        smallest,
        np.sqrt(left.error),
        np.sqrt(left.drive),
        bound_by=(MARGIN,) if smallest.modulus < (1.0 + AT_BOUND) * scene.table.modulus_margin else (),
    )


def _margins(plant: WholePlant, controller: WholeController) -> WholeMargins:
    """The margins with all axes closed; none where the loop is unstable."""
    try:
        return whole_margins(plant, controller)
    except ValueError:
        return WholeMargins(0.0, MultiloopMargin(0.0, 0.0), 0.0)


def _tuned(
    scene: CoupledScene, family: Family, of: Sequence[WholePlant], margin: float
) -> tuple[WholeController, dict[str, float]]:
    """The best controller of a family for some plants, and its values: of the whole, else each axis by itself."""
    asked, seed = Specification(margin), scene.table.seed
    if family not in OF_AXES:
        angles = loop_directions(of[0])
        alone_of = [[alone(along(plant, angles), loop) for plant in of] for loop in range(scene.loop.axes)]
        each = [control.tune(family, plants, asked, seed=seed, survey=SURVEY) for plants in alone_of]
        values = {} if angles == ALONG_AXES else {DIRECTION.format(i): a for i, a in enumerate(angles, 1)}
        named = zip(AXES if angles == ALONG_AXES else "12", each, strict=True)
        values |= {f"{name} {loop}": v for loop, t in named for name, v in t.values.items()}
        return on_axes(side_by_side(family.name, [t.controller for t in each]), angles), values
    return tuned_whole(family, of, asked)


def tuned_whole(
    family: Family, of: Sequence[WholePlant], asked: Specification
) -> tuple[WholeController, dict[str, float]]:
    """The controller of all axes of one of `OF_AXES` that leaves the least mean variance, and its values by name.

    Args:
        family: Kind of controller.
        of: Plants of the same axes; the controller is built for the first.
        asked: What the loop of all axes has to respect on each of them.

    Raises:
        ValueError: No controller of the family keeps it; says what the best one reaches.
    """
    search = Search(family, of, asked, scope=ALL_AXES)
    near = min((descend(search, start) for start in _weights(search)), key=lambda t: t.score)
    best = settled(search, [near], MODELS)
    of_all = zip((p.name for p in search.parameters), best.values.tolist(), strict=True)
    assert family.final is not None
    return family.final(of[0], best.values), dict(of_all)


def _weights(search: Search) -> list[Trial]:
    """Places all over the weights of a controller of all axes, of which the best ones are followed."""
    fifths = [(np.arange(5) + 0.5) / 5.0] * len(search.parameters)
    surveyed = search.at_all([np.array(place) for place in product(*fifths)])
    return apart(sorted(surveyed, key=lambda t: t.score), STARTS, 0.1)


def outlook(
    scene: CoupledScene, designs: Sequence[CoupledDesign], on_progress: Progress = lambda done, total, what: None
) -> tuple[CoupledOutlook, ...]:
    """Each design's linear figures beside those simulated with hysteresis, in one batch of shortened runs.

    Args:
        scene: The mission's loop.
        designs: The designs, in the order that is wanted.
        on_progress: Called with the parts of the work that are done, their number and what is done.
    """
    found = shortened(scene.table, scene.loop, [d.controller for d in designs], on_progress)
    return tuple(
        CoupledOutlook(tuple(map(Outlook, d.residual_rad.tolist(), each.axis_rms_rad.tolist())))
        for d, each in zip(designs, found, strict=True)
    )
