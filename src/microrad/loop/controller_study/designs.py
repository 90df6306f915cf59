"""The controllers of the study: each tuned for one axis of the mission's loop, then put on all axes."""

import math
from collections import ChainMap
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Protocol

import numpy as np

from microrad.core.progress import Progress
from microrad.core.threads import shared_out
from microrad.loop import control
from microrad.loop.control import DesignPlant, Family, Specification, Tuned
from microrad.loop.controller_study.scenario import Scene
from microrad.loop.pointing_loop.design import behind_filter, design_plant
from microrad.loop.pointing_loop.loop import (
    LoopController,
    PointingLoop,
    ReferenceFilter,
    assemble,
    with_adaptation,
    with_inverse,
)
from microrad.mirror import from_table, hysteresis_model, spread
from microrad.mission.tables.fine_pointing import FinePointing
from microrad.mission.tables.mirror import Mirror as MirrorTable

BASELINE = "PI, best of a gain grid"
WITH_INVERSE = f"{control.PI.name} + inverse"
IN_SERIES = "PI + inverse in series"
ADAPTIVE = "PI + adaptive inverse in series"
_INVERSE_USED = {WITH_INVERSE: "of the reference", IN_SERIES: "in series", ADAPTIVE: "in series"}
DRAWS = 8
"""Mirrors drawn from the identification's covariance that a tuned controller has to hold for."""

GRID = 24
"""Values of each gain on the grid of the baseline."""


class AnyDesign(Protocol):
    """A controller of all axes that was designed, on whatever mirror; `Design` says what its fields mean."""

    @property
    def name(self) -> str:
        """What it is called."""
        ...

    @property
    def controller(self) -> LoopController:
        """The controller of all axes."""
        ...

    @property
    def inverse(self) -> str:
        """How an inverse is used."""
        ...

    @property
    def margin(self) -> float | None:
        """Modulus margin that it was tuned for in place of the mission's."""
        ...

    @property
    def values(self) -> Mapping[str, float]:
        """What it was tuned to, by name, in SI units."""
        ...

    @property
    def bound_by(self) -> Sequence[str]:
        """What keeps its residual from being smaller."""
        ...

    @property
    def loop_margins(self) -> control.LoopMargins:
        """Margins of its linear loop."""
        ...


@dataclass(frozen=True, slots=True)
class Design:
    """One controller of the study: what it was tuned to, on all axes; ``inverse`` says how one is used.

    ``margin`` is the modulus margin that it was tuned for where the mirror's hysteresis asks for more than the
    mission's, else None.
    """

    name: str
    tuned: Tuned
    controller: LoopController
    inverse: str = ""
    margin: float | None = None

    @property
    def values(self) -> Mapping[str, float]:
        """What it was tuned to, by name, in SI units."""
        return self.tuned.values

    @property
    def bound_by(self) -> Sequence[str]:
        """What keeps its residual from being smaller."""
        return self.tuned.bound_by

    @property
    def loop_margins(self) -> control.LoopMargins:
        """Margins of the nominal loop of an axis."""
        return self.tuned.margins


def families(f: FinePointing) -> tuple[Family, ...]:
    """Kinds of controller that fit the loop: peak filters where it has wheels, damping where it has a gauge."""
    lines = () if f.wheels is None else tuple(h * f.wheels.speed_hz for h in f.wheels.harmonics)
    below = tuple(line for line in lines if line < 0.4 * f.rate_hz)
    found = [control.PI, control.PI_NOTCH]
    found += [control.RESONANT_DAMPING] if f.strain_gauge is not None else []
    found += [control.DISTURBANCE_OBSERVER, control.LQG]
    return (*found, *([control.peak_family(below)] if below else []))


def plants(scene: Scene, seed: int) -> tuple[DesignPlant, ...]:
    """The nominal plant of an axis, then one for each mirror drawn from the identification's covariance.

    Args:
        scene: The mission's fine-pointing loop; without an uncertainty of its mirror there is the nominal plant alone.
        seed: Seed of the mirrors that are drawn.
    """
    of = scene.mirrors.table
    drawn = spread.draws(of, DRAWS, seed) if of.uncertainty is not None else ()
    loops = [scene.axis, *(replace(scene.axis, mirror=from_table(t)) for t in drawn)]
    return tuple(design_plant(loop) for loop in loops)


def names(f: FinePointing) -> tuple[str, ...]:
    """The controllers that the study of a mission designs, the baseline first."""
    found = [BASELINE]
    for family in families(f):
        found += [family.name, WITH_INVERSE] if family is control.PI else [family.name]
    return (*found, IN_SERIES)


def offered(f: FinePointing, of: MirrorTable) -> tuple[str, ...]:
    """The controllers that can be designed for a mission: `names`, and the adaptive inverse where it can learn.

    It learns the weights of play operators that do not widen, of a mirror that has them, from a strain gauge.

    Args:
        f: The mission's fine-pointing table.
        of: Its mirror's table.
    """
    learns = f.strain_gauge is not None and not control.cannot_learn(hysteresis_model(of, math.inf, 0.0))
    return (*names(f), *([ADAPTIVE] if learns else []))


def design(
    scene: Scene,
    on_progress: Progress = lambda done, total, what: None,
    only: Sequence[str] = (),
) -> tuple[Design, ...]:
    """Design every controller of the study, or some of them; tuned on the linear cost.

    Args:
        scene: The mission's fine-pointing loop.
        on_progress: Called with the controllers that are tuned, their number and what is done.
        only: Names out of `offered`, in the order that is wanted; by default all of `names`, the baseline first.

    Raises:
        ValueError: For a name that `offered` does not list, and where a modulus margin cannot be met; says why.
    """
    import scipy.optimize  # noqa: F401  slow to import: once, ahead of the other process

    of, wanted = plants(scene, scene.table.seed), tuple(only) or names(scene.table)
    groups = _groups(wanted, scene.table)
    jobs = [partial(_tuned_in_turn, {name: _tuning(name, scene.table, of) for name in group}) for group in groups]

    def told(turn: int) -> None:
        on_progress(sum(map(len, groups[:turn])), len(wanted), f"tuning {groups[turn][0]}")

    with shared_out(jobs, told) as results:
        tuned = dict(ChainMap(*results()))
    on_progress(len(wanted), len(wanted), "controllers tuned")
    return tuple(
        Design(name, tuned[name], build(name, scene, tuned[name].controller), _INVERSE_USED.get(name, ""))
        for name in wanted
    )


def _groups(wanted: Sequence[str], f: FinePointing) -> list[list[str]]:
    """Names of what one process tunes: those that begin with the PI in one group, behind what takes longest."""
    with_pi = [family.name for family in families(f) if family.base is control.PI]
    together = [name for first in ([control.PI.name, WITH_INVERSE], with_pi) for name in wanted if name in first]
    alone = [[name] for name in wanted if name not in together]
    return sorted([group for group in (together, *alone) if group], key=lambda group: group != [control.LQG.name])


def _tuned_in_turn(group: Mapping[str, Callable[..., Tuned]]) -> dict[str, Tuned]:
    """The controllers of a group, by name; the PI, where it is one of them, is tuned once and stands first."""
    found: dict[str, Tuned] = {}
    for name, tuning in group.items():
        pi = found.get(next(iter(group))) if {control.PI.name, WITH_INVERSE} & {*found} else None
        if pi is None:
            found[name] = tuning()
        else:
            found[name] = pi if name == WITH_INVERSE else tuning(base=pi)
    return found


def tune(name: str, f: FinePointing, of: Sequence[DesignPlant]) -> Tuned:
    """Tune one of the controllers that `names` lists.

    Args:
        name: Its name.
        f: The mission's fine-pointing table: modulus margin, seed and reference filter.
        of: Plants of an axis, the nominal one first (see `plants`).

    Raises:
        ValueError: For another name, and where the controller cannot meet the modulus margin; says why.
    """
    return _tuning(name, f, of)()


def _tuning(name: str, f: FinePointing, of: Sequence[DesignPlant]) -> Callable[..., Tuned]:
    """What tunes one, and reads no table: it may run in another process. Families with the PI take that as ``base``."""
    wanted = Specification(f.modulus_margin)
    if name == BASELINE:
        return partial(grid_baseline, of, wanted)
    if name in (IN_SERIES, ADAPTIVE):
        path = ReferenceFilter(f.reference_filter_hz)
        filtered = tuple(behind_filter(p, path.discrete(p.period_s)) for p in of)
        return partial(control.tune, control.PI, filtered, wanted, seed=f.seed)
    wanted_family = control.PI.name if name == WITH_INVERSE else name
    for family in families(f):
        if family.name == wanted_family:
            return partial(control.tune, family, of, wanted, seed=f.seed)
    raise ValueError(f"{name!r} is no controller of this mission; it has {', '.join(names(f))}")


def build(name: str, scene: Scene, axis: control.AxisController) -> LoopController:
    """Put a tuned axis controller on all axes of the scene, with its inverse where its name says so.

    Args:
        name: One of `offered`.
        scene: The mission's fine-pointing loop.
        axis: The controller of one axis.

    Raises:
        ValueError: The controller reads a gauge that the loop lacks, or its mirror has no inverse, or none that learns.
    """
    if name not in _INVERSE_USED:
        return assemble(name, scene.loop, axis)
    path, inverse = ReferenceFilter(scene.table.reference_filter_hz), control.inverse(scene.loop.mirror)
    made = with_inverse(name, scene.loop, axis, inverse, path, name != WITH_INVERSE)
    return with_adaptation(made, scene.loop) if name == ADAPTIVE else made


def on_one_axis(made: Design, scene: Scene) -> LoopController:
    """A design on the loop of one axis, ``scene.axis``.

    Args:
        made: One of `design`.
        scene: The mission's fine-pointing loop.
    """
    return build(made.name, replace(scene, loop=scene.axis), made.tuned.controller)


def grid_baseline(of: Sequence[DesignPlant], wanted: Specification) -> Tuned:
    """The best PI on a grid of both its parameters over their whole range: what the tuned ones are held against.

    Args:
        of: Plants of an axis, the nominal one first.
        wanted: What the controller has to respect on every one of them.

    Raises:
        ValueError: No PI of the grid respects it.
    """
    parameters = control.PI.parameters(of[0])
    axes = [np.geomspace(p.least, p.most, GRID) if p.log else np.linspace(p.least, p.most, GRID) for p in parameters]
    return control.grid_best(control.PI, of, wanted, [[control.rounded(v) for v in axis] for axis in axes])


def optimum_rms_rad(axis: PointingLoop) -> float:
    """Rms of one axis under the controller that leaves least of all linear ones: LQG without a price on anything else.

    Integral action and margins are left out, so it is a bound and no design.
    """
    plant = design_plant(axis)
    best = control.lqg_controller(plant, control.Weights(command=1e-6, sensor_noise=1.0, command_noise_v=0.0, walk=0.0))
    return math.sqrt(sum(control.by_source(plant, best).values()))
