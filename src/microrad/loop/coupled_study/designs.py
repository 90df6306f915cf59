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
from microrad.loop.control import (
    LQG,
    LQG_OF_AXES,
    PI,
    Family,
    MultiloopMargin,
    Specification,
    WholeController,
    WholePlant,
)
from microrad.loop.control.descent import descend
from microrad.loop.control.search import Search, Trial, apart
from microrad.loop.control.tuning import cheapest_that_holds, hypercube, settled
from microrad.loop.controller_study import designs as one_axis
from microrad.loop.controller_study.promises import firmer
from microrad.loop.controller_study.results import Outlook, shortened
from microrad.loop.controller_study.scenario import references
from microrad.loop.coupled_study.scene import AXES, CoupledScene
from microrad.loop.coupled_study.whole import ALL_AXES, WholeMargins, alone, of_all_axes, whole_margins
from microrad.loop.pointing_loop.design import whole_plant
from microrad.loop.pointing_loop.feedforward import with_feedforward
from microrad.loop.pointing_loop.linear import close, stationary
from microrad.loop.pointing_loop.loop import LoopController, ReferenceFilter, assemble_whole, decoupling
from microrad.mission.tables.fine_pointing import FinePointing

WITH_FEEDFORWARD = f"{PI.name} + feedforward"
"""The PI with the mirror's hysteresis run forward on the reference: the same feedback, and so the same margins."""

STARTS = 3
"""Places from which an axis by itself, and the weights of LQG, are followed."""

MODELS, CANDIDATES = 8, 800
"""Quadratic models of the whole that an optimum is followed by, and about how many candidates they may take: with ten
parameters each model takes 220."""

NOMINAL, ADDED = 2, 3
"""Plants that controllers are tuned for at first, at rest and over the whole range, and how many are added at most."""

SPARE = 0.002
"""Share of its margin that a candidate is to have to spare where no optimum on the margin was found."""

SURVEY = 40
"""Places that the search of an axis by itself begins with, whose result is but where that of the whole begins."""


@dataclass(frozen=True, slots=True, eq=False)
class CoupledDesign:
    """One controller of all axes, and what the whole loop has of it.

    ``tuned`` are the values that it was tuned to, by name. ``margins`` are the smallest over all linear loops of the
    scene, each with all axes closed. ``residual_rad`` is the rms of each axis for small motions about rest, linear, and
    ``drive_v`` that of each drive. ``margin`` is the modulus margin that it was tuned for where the mirror's hysteresis
    asks for more than the mission's, else None.
    """

    name: str
    tuned: Mapping[str, float]
    controller: LoopController
    margins: WholeMargins
    residual_rad: Floats
    drive_v: Floats
    margin: float | None = None


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


def names(f: FinePointing) -> tuple[str, ...]:
    """The controllers that are designed for a mirror of several axes; a feedforward where a reference is known."""
    known = any(each.point_ahead_rad or each.line_of_sight_rate_rad_s for each in references(f))
    found = [family.name for family in one_axis.families(f)]
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

    LQG is one controller of all axes. Of the other families each axis has one, and those of all axes are tuned
    together: their search begins where each axis is best by itself, and where the family that they contain is best, so
    that they are never worse than that.

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
    tuned = [*dict.fromkeys(_feedback(name) for name in wanted)]
    turns = [[name for name in tuned if families[name].base or families[name] is PI], *([n] for n in tuned)]
    turns = [turn for i, turn in enumerate(turns) if turn and (i == 0 or not {*turn} & {*turns[0]})]
    jobs = [partial(_designed_in_turn, scene, [families[name] for name in turn], of) for turn in turns]
    with shared_out(jobs, lambda i: on_progress(i, len(turns), f"tuning {turns[i][0]}")) as results:
        found: ChainMap[str, CoupledDesign | str] = ChainMap(*results())
    on_progress(len(turns), len(turns), "controllers tuned")
    done = {name: found[_feedback(name)] for name in wanted}
    made = {name: _as_named(scene, name, each) for name, each in done.items() if isinstance(each, CoupledDesign)}
    if not made:
        raise ValueError("; ".join(str(each) for each in done.values()))
    return CoupledDesigns(tuple(made.values()), {name: str(each) for name, each in done.items() if name not in made})


def _feedback(name: str) -> str:
    """The controller whose feedback one of `names` has."""
    return PI.name if name == WITH_FEEDFORWARD else name


def _as_named(scene: CoupledScene, name: str, design: CoupledDesign) -> CoupledDesign:
    """The design of a feedback, with the feedforward where the name says so."""
    if name != WITH_FEEDFORWARD:
        return design
    path = ReferenceFilter(scene.table.reference_filter_hz)
    return replace(design, name=name, controller=with_feedforward(name, scene.loop, design.controller, path))


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
    (family,) = (each for each in one_axis.families(scene.table) if each.name == _feedback(broken.name))

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
    """The best controller of a family for the first plants that keeps its margin on all of them.

    A plant on which the margin is missed is added to those that it is tuned for.
    """
    asked, tuned_for = scene.table.modulus_margin, [*range(min(NOMINAL, len(of)))]
    begun: Floats | None = None
    for _ in range(ADDED + 1):
        made, values = _tuned(scene, family, [of[i] for i in tuned_for], base, begun)
        margins = [_margins(plant, made) for plant in of]
        moduli = [each.modulus for each in margins]
        worst = int(np.argmin(moduli))
        if moduli[worst] >= asked or worst in tuned_for:
            break
        tuned_for.append(worst)
        begun = np.array(list(values.values()))
    if moduli[worst] < asked:
        raise ValueError(
            f"{family.name} keeps a modulus margin of {moduli[worst]:.3g} on one of {len(of)} mirrors that the "
            f"identification leaves possible, where {asked:g} is asked for; identify it from more records, lower "
            "fine_pointing.modulus_margin, or take another controller"
        )
    on_drives = assemble_whole(family.name, scene.rest, made.system, made.anti_windup)
    left = stationary(close(scene.rest, on_drives))
    smallest = WholeMargins(
        min(moduli),
        min((each.disk for each in margins), key=lambda margin: margin.disk),
        min(each.bandwidth_hz for each in margins),
    )
    return CoupledDesign(family.name, values, on_drives, smallest, np.sqrt(left.error), np.sqrt(left.drive))


def _margins(plant: WholePlant, controller: WholeController) -> WholeMargins:
    """The margins with all axes closed; none where the loop is unstable."""
    try:
        return whole_margins(plant, controller)
    except ValueError:
        return WholeMargins(0.0, MultiloopMargin(0.0, 0.0), 0.0)


def _tuned(
    scene: CoupledScene,
    family: Family,
    of: Sequence[WholePlant],
    base: CoupledDesign | None,
    begun: Floats | None,
) -> tuple[WholeController, dict[str, float]]:
    """The best controller of a family for some plants, and its values.

    The search begins where each axis is best by itself and where the base is best, or at the values that it has begun
    with on fewer plants.
    """
    asked = Specification(scene.table.modulus_margin)
    whole = LQG_OF_AXES if family is LQG else of_all_axes(family, of[0], AXES)
    search = Search(whole, of, asked, scope=ALL_AXES)
    if begun is not None:
        starts = [search.of(begun)]
    else:
        starts = _weights(search) if family is LQG else [_by_axis(scene, family, of, search)]
        if base is not None and family.extended is not None:
            parts = np.split(np.array(list(base.tuned.values())), scene.loop.axes)
            extended = [family.extended(alone(of[0], axis), part) for axis, part in enumerate(parts)]
            starts.append(search.of(np.concatenate(extended)))
    near = min((descend(search, each) for each in starts), key=lambda t: t.score)
    count = len(search.parameters)
    try:
        best = settled(search, [near], max(2, min(MODELS, CANDIDATES // (2 * count * (count + 1)))))
    except ValueError:
        best = cheapest_that_holds(search, SPARE)
    values = dict(zip((p.name for p in search.parameters), best.values.tolist(), strict=True))
    return (whole.final or whole.build)(of[0], best.values), values


def _weights(search: Search) -> list[Trial]:
    """Places all over the weights of LQG, of which the best ones are followed."""
    fifths = [(np.arange(5) + 0.5) / 5.0] * len(search.parameters)
    surveyed = search.at_all([np.array(place) for place in product(*fifths)])
    return apart(sorted(surveyed, key=lambda t: t.score), STARTS, 0.1)


def _by_axis(scene: CoupledScene, family: Family, of: Sequence[WholePlant], search: Search) -> Trial:
    """Each axis as it is best by itself, to where a rough search ends: the whole goes on from there."""
    best = []
    for axis in range(scene.loop.axes):
        own = Search(family, [alone(plant, axis) for plant in of], search.specification)
        surveyed = own.at_all(list(hypercube(len(own.parameters), SURVEY, scene.table.seed)))
        starts = apart(sorted(surveyed, key=lambda t: t.score), STARTS, 0.1)
        best.append(min((descend(own, start) for start in starts), key=lambda t: t.score))
    return search.of(np.concatenate([trial.values for trial in best]))


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
