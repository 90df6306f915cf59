"""Controllers of a mission's fine-pointing loop for a mirror of several axes, with the margins of the whole."""

from microrad.loop.coupled_study.designs import (
    OF_AXES,
    CoupledDesign,
    CoupledDesigns,
    CoupledOutlook,
    as_named,
    design,
    design_and_promise,
    design_and_simulate,
    feedback_of,
    names,
    outlook,
    plants,
    tuned_whole,
)
from microrad.loop.coupled_study.scene import AXES, CoupledScene, of_mission, scene
from microrad.loop.coupled_study.whole import WholeMargins, whole_margins

__all__ = [
    "AXES",
    "OF_AXES",
    "CoupledDesign",
    "CoupledDesigns",
    "CoupledOutlook",
    "CoupledScene",
    "WholeMargins",
    "as_named",
    "design",
    "design_and_promise",
    "design_and_simulate",
    "feedback_of",
    "names",
    "of_mission",
    "outlook",
    "plants",
    "scene",
    "tuned_whole",
    "whole_margins",
]
