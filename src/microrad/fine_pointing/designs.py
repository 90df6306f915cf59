"""The controllers of the study: each tuned for one axis of the mission's loop, then put on all axes."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from microrad import control, mirror, mirror_spread
from microrad.control import DesignPlant, Family, Specification, Tuned
from microrad.fine_loop.design import behind_filter, design_plant
from microrad.fine_loop.loop import LoopController, PointingLoop, ReferenceFilter, assemble, with_inverse
from microrad.fine_pointing.scenario import Scene, one_mirror, table
from microrad.mission import Mission

Progress = Callable[[int, int, str], None]

BASELINE = "PI, best of a gain grid"
DRAWS = 8
"""Mirrors drawn from the identification's covariance that a tuned controller has to hold for."""

GRID = 24
"""Values of each gain on the grid of the baseline."""


@dataclass(frozen=True, slots=True)
class Design:
    """One controller of the study: what it was tuned to, on all axes; ``in_series`` names how an inverse is used."""

    name: str
    tuned: Tuned
    controller: LoopController
    inverse: str = ""


def families(m: Mission) -> tuple[Family, ...]:
    """Kinds of controller that fit the mission: peak filters where it has wheels, damping where it has a gauge."""
    f = table(m)
    lines = () if f.wheels is None else tuple(h * f.wheels.speed_hz for h in f.wheels.harmonics)
    below = tuple(line for line in lines if line < 0.4 * f.rate_hz)
    found = [control.PI, control.PI_NOTCH]
    found += [control.RESONANT_DAMPING] if f.strain_gauge is not None else []
    found += [control.DISTURBANCE_OBSERVER, control.LQG]
    return (*found, *([control.peak_family(below)] if below else []))


def plants(scene: Scene, m: Mission, seed: int) -> tuple[DesignPlant, ...]:
    """The nominal plant of an axis, then one for each mirror drawn from the identification's covariance."""
    drawn = mirror_spread.draws(m.mirror, DRAWS, seed) if m.mirror.uncertainty is not None else ()
    loops = [scene.axis, *(replace(scene.axis, mirror=_drawn(m, t)) for t in drawn)]
    return tuple(design_plant(loop) for loop in loops)


def _drawn(m: Mission, of: object) -> mirror.Mirror:
    return one_mirror(m.model_copy(update={"mirror": of}), "given")


def design(scene: Scene, m: Mission, on_progress: Progress = lambda done, total, what: None) -> tuple[Design, ...]:
    """Every controller of the study, tuned on the linear cost; the first is the baseline.

    Raises ValueError with the reason when one of them cannot meet the modulus margin.
    """
    f = table(m)
    wanted = Specification(f.modulus_margin)
    straight = plants(scene, m, f.seed)
    path = ReferenceFilter(f.reference_filter_hz)
    kinds = families(m)
    total = len(kinds) + 2
    on_progress(0, total, f"tuning {BASELINE}")
    found = [_plain(BASELINE, scene.loop, grid_baseline(straight, wanted))]
    for done, family in enumerate(kinds, 1):
        on_progress(done, total, f"tuning {family.name}")
        tuned = control.tune(family, straight, wanted, seed=f.seed, evaluations=evaluations(family))
        found.append(_plain(family.name, scene.loop, tuned))
        if family is control.PI:
            inverse = control.inverse(scene.loop.mirror)
            made = with_inverse(f"{family.name} + inverse", scene.loop, tuned.controller, inverse, path, False)
            found.append(Design(made.name, tuned, made, "of the reference"))
    on_progress(total - 1, total, "tuning PI with the inverse in series")
    filtered = tuple(behind_filter(p, path.discrete(p.period_s)) for p in straight)
    tuned = control.tune(control.PI, filtered, wanted, seed=f.seed)
    name = "PI + inverse in series"
    inverse = control.inverse(scene.loop.mirror)
    made = with_inverse(name, scene.loop, tuned.controller, inverse, path, True)
    on_progress(total, total, "controllers tuned")
    return (*found, Design(name, tuned, made, "in series"))


def evaluations(family: Family) -> int:
    """How many candidates a search may look at: more change its result by less than a per cent."""
    return 400 if family is control.LQG else 300


def _plain(name: str, loop: PointingLoop, tuned: Tuned) -> Design:
    return Design(name, tuned, assemble(name, loop, tuned.controller))


def grid_baseline(of: Sequence[DesignPlant], wanted: Specification) -> Tuned:
    """The best PI on a grid of both its parameters over their whole range: what the tuned ones are held against."""
    parameters = control.PI.parameters(of[0])
    axes = [np.geomspace(p.least, p.most, GRID) if p.log else np.linspace(p.least, p.most, GRID) for p in parameters]
    return control.grid_best(control.PI, of, wanted, [[float(v) for v in axis] for axis in axes])


def optimum_rms_rad(axis: PointingLoop) -> float:
    """Rms of one axis under the controller that leaves least of all linear ones: LQG without a price on anything else.

    Integral action and margins are left out, so it is a bound and no design.
    """
    plant = design_plant(axis)
    best = control.lqg_controller(plant, control.Weights(command=1e-6, sensor_noise=1.0, command_noise_v=0.0, walk=0.0))
    return math.sqrt(sum(control.by_source(plant, best).values()))
