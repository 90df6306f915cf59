"""The fine-pointing study of a mission: its loop, controllers tuned for it, and what they leave under disturbances."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from microrad.core.arrays import Floats
from microrad.core.progress import Progress
from microrad.loop import disturbance
from microrad.loop.controller_study.designs import (
    BASELINE,
    AnyDesign,
    Design,
    build,
    families,
    names,
    offered,
    on_one_axis,
    optimum_rms_rad,
    plants,
    tune,
)
from microrad.loop.controller_study.designs import design as plain_designs
from microrad.loop.controller_study.promises import design, design_and_promise
from microrad.loop.controller_study.results import (
    PROMISE,
    Difference,
    ErrorBudget,
    Outlook,
    Part,
    Residual,
    Sine,
    Verified,
    best,
    error_budget,
    outlook,
    sines,
    verify,
)
from microrad.loop.controller_study.scenario import AnyScene, Scene, scene, table

__all__ = [
    "BASELINE",
    "PROMISE",
    "AnyDesign",
    "AnyScene",
    "Design",
    "Difference",
    "ErrorBudget",
    "FinePointingStudy",
    "Outlook",
    "Part",
    "Residual",
    "Scene",
    "Sine",
    "Verified",
    "best",
    "build",
    "design",
    "design_and_promise",
    "design_and_simulate",
    "design_and_simulate_one",
    "error_budget",
    "families",
    "names",
    "offered",
    "on_one_axis",
    "optimum_rms_rad",
    "outlook",
    "plants",
    "scene",
    "simulated",
    "sines",
    "table",
    "tune",
    "verify",
]


@dataclass(frozen=True, slots=True)
class FinePointingStudy:
    """Everything that a report shows of the fine-pointing loop.

    ``disturbed_rad2_hz`` is the spectrum of an axis before the loop, at ``freq_hz``; the first of ``verified`` is the
    baseline and ``best`` one of the others. ``quantile`` is the share of the time that errors are judged at, and
    ``optimum_rad`` the radial rms below which no linear controller comes on the nominal mirror, whatever its margins.
    """

    scene: AnyScene
    verified: tuple[Verified, ...]
    best: Verified
    budget: ErrorBudget
    sines: tuple[Sine, ...]
    freq_hz: Floats
    disturbed_rad2_hz: Floats
    quantile: float
    optimum_rad: float


def design_and_simulate(scene: Scene, on_progress: Progress = lambda done, total, what: None) -> FinePointingStudy:
    """Design, tune and simulate controllers for a fine-pointing loop; seeded by its table.

    All are tuned for the mission's margin: what hysteresis makes of them is what is simulated here.

    Args:
        scene: The mission's fine-pointing loop.
        on_progress: Called with what is done of the step at hand, of how much, and the step in words.

    Raises:
        ValueError: A controller cannot meet its margin; says why.
    """
    designs, bound = plain_designs(scene, on_progress), math.sqrt(scene.loop.axes) * optimum_rms_rad(scene.axis)
    return simulated(scene, designs, bound, on_progress)


def simulated(
    scene: AnyScene,
    designs: Sequence[AnyDesign],
    optimum_rad: float,
    on_progress: Progress = lambda done, total, what: None,
) -> FinePointingStudy:
    """The study of a loop, from the controllers that were designed for it.

    Args:
        scene: The mission's fine-pointing loop.
        designs: The controllers, the one that others are held against first.
        optimum_rad: Radial rms below which no linear controller comes, whatever its margins.
        on_progress: Called with what is done of the step at hand, of how much, and the step in words.
    """
    verified = verify(scene, designs, on_progress)
    chosen = best(verified)
    segment = 2 * (verified[0].spectrum_rad2_hz.shape[0] - 1)
    freq = np.asarray(np.fft.rfftfreq(segment, scene.loop.timing.period_s), dtype=float)
    before = np.sum([disturbance.psd(each, freq) for each in scene.loop.disturbances[0]], axis=0)
    return FinePointingStudy(
        scene,
        verified,
        chosen,
        error_budget(scene, chosen, on_progress),
        sines(scene, designs, on_progress),
        freq,
        before,
        scene.table.quantile,
        optimum_rad,
    )


def design_and_simulate_one(scene: Scene, name: str) -> Verified:
    """One controller of the loop as `design_and_simulate` has it, without the others.

    Args:
        scene: The mission's fine-pointing loop.
        name: One of `names`.

    Raises:
        ValueError: Another name, or the controller cannot meet its margin.
    """
    (found,) = verify(scene, plain_designs(scene, only=(name,)))
    return found
