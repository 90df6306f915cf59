"""Controllers: from gains or a specification to matrices, inverses of hysteresis, margins of the sampled loop.

The fine-pointing loop has `problem`, `classical`, `lqg` and `tuning`, and its margins are in `analysis`. The loop of
`[control]`, the paper's, has `sampled`, with its margins and the inverses of hysteresis.
"""

from microrad.loop.control.adaptive import Adaptation, adaptation, adaptive_arrays, at_the_begin, cannot_learn
from microrad.loop.control.analysis import (
    LoopMargins,
    MultiloopMargin,
    by_source,
    loop_margins,
    multiloop_disk_margin,
)
from microrad.loop.control.classical import (
    DISTURBANCE_OBSERVER,
    PI,
    PI_NOTCH,
    RESONANT_DAMPING,
    peak_family,
)
from microrad.loop.control.h_infinity import H_INFINITY_OF_AXES
from microrad.loop.control.lqg import LQG, LQG_OF_AXES, Weights, lqg_controller, lqg_of_axes
from microrad.loop.control.problem import (
    GAUGE,
    OPTICAL,
    RESIDUAL,
    AxisController,
    DesignPlant,
    Family,
    Specification,
    WholeController,
    WholePlant,
)
from microrad.loop.control.sampled import (
    Drive,
    Gains,
    Inverse,
    Timing,
    amplifier_factor,
    anti_windup,
    drive_from_mission,
    gains_from_mission,
    inverse,
    inverse_arrays,
    margins,
    no_feedforward,
    pid,
    sampled_path,
    sampled_plant,
    sensitivity,
    slowest_pole,
    timing_from_mission,
)
from microrad.loop.control.search import rounded
from microrad.loop.control.tuning import Tuned, grid_best, tune

__all__ = [
    "DISTURBANCE_OBSERVER",
    "GAUGE",
    "H_INFINITY_OF_AXES",
    "LQG",
    "LQG_OF_AXES",
    "OPTICAL",
    "PI",
    "PI_NOTCH",
    "RESIDUAL",
    "RESONANT_DAMPING",
    "Adaptation",
    "AxisController",
    "DesignPlant",
    "Drive",
    "Family",
    "Gains",
    "Inverse",
    "LoopMargins",
    "MultiloopMargin",
    "Specification",
    "Timing",
    "Tuned",
    "Weights",
    "WholeController",
    "WholePlant",
    "adaptation",
    "adaptive_arrays",
    "amplifier_factor",
    "anti_windup",
    "at_the_begin",
    "by_source",
    "cannot_learn",
    "drive_from_mission",
    "gains_from_mission",
    "grid_best",
    "inverse",
    "inverse_arrays",
    "loop_margins",
    "lqg_controller",
    "lqg_of_axes",
    "margins",
    "multiloop_disk_margin",
    "no_feedforward",
    "peak_family",
    "pid",
    "rounded",
    "sampled_path",
    "sampled_plant",
    "sensitivity",
    "slowest_pole",
    "timing_from_mission",
    "tune",
]
