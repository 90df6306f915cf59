"""The fine-pointing study of a mission: its loop, controllers tuned for it, and what they leave under disturbances."""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from microrad.loop import disturbance
from microrad.loop.fine_pointing.designs import (
    BASELINE,
    Design,
    build,
    design,
    names,
    optimum_rms_rad,
    plants,
    tune,
)
from microrad.loop.fine_pointing.results import (
    COUNTERS,
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
    on_variant,
    outlook,
    sines,
    verify,
)
from microrad.loop.fine_pointing.scenario import VARIANTS, Scene, scene, table
from microrad.mission.file import MissionFile

__all__ = [
    "BASELINE",
    "COUNTERS",
    "PROMISE",
    "VARIANTS",
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
    "error_budget",
    "names",
    "on_variant",
    "optimum_rms_rad",
    "outlook",
    "plants",
    "run",
    "run_one",
    "scene",
    "sines",
    "table",
    "tune",
    "verify",
]

Floats = NDArray[np.float64]
Progress = Callable[[int, int, str], None]


@dataclass(frozen=True, slots=True)
class FinePointingStudy:
    """Everything that a report shows of the fine-pointing loop.

    ``disturbed_rad2_hz`` is the spectrum of an axis before the loop, at ``freq_hz``; the first of ``verified`` is the
    baseline and ``best`` one of the others. ``quantile`` is the share of the time that errors are judged at, and
    ``optimum_rad`` the radial rms below which no linear controller comes on the nominal mirror, whatever its margins.
    """

    scene: Scene
    verified: tuple[Verified, ...]
    best: Verified
    budget: ErrorBudget
    sines: tuple[Sine, ...]
    freq_hz: Floats
    disturbed_rad2_hz: Floats
    quantile: float
    optimum_rad: float


def run(file: MissionFile, on_progress: Progress = lambda done, total, what: None) -> FinePointingStudy:
    """Design, tune and simulate the mission's fine-pointing loop; seeded by the mission.

    Raises ValueError with the reason for a loop that cannot be built and a controller that cannot meet its margin.
    """
    m, built = file.mission, scene(file)
    verified = verify(built, m, design(built, m, on_progress), on_progress)
    chosen, designs = best(verified), [v.design for v in verified]
    segment = 2 * (verified[0].spectrum_rad2_hz.shape[0] - 1)
    freq = np.asarray(np.fft.rfftfreq(segment, built.loop.timing.period_s), dtype=float)
    before = np.sum([disturbance.psd(each, freq) for each in built.loop.disturbances[0]], axis=0)
    return FinePointingStudy(
        built,
        verified,
        chosen,
        error_budget(built, m, chosen, on_progress),
        sines(built, m, designs, on_progress),
        freq,
        before,
        table(m).quantile,
        math.sqrt(built.loop.axes) * optimum_rms_rad(built.axis),
    )


def run_one(file: MissionFile, name: str) -> Verified:
    """One controller of the mission, tuned and simulated as `run` does it, without the others; `names` lists them.

    Raises ValueError for another name, and as `run`.
    """
    m, built = file.mission, scene(file)
    (found,) = verify(built, m, design(built, m, only=(name,)))
    return found
