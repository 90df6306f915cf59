"""The worst that a loop may become on an identified mirror, over what the identification leaves open of it."""

from microrad.loop.worst_case.batch import Figures, figures
from microrad.loop.worst_case.in_time import InTime, Simulated, course
from microrad.loop.worst_case.search import (
    APE,
    Extent,
    Quantiles,
    Sensitivity,
    Subject,
    Worst,
    WorstCase,
    of_coupled_scene,
    of_scene,
    worst_case,
)
from microrad.loop.worst_case.uncertain import Uncertain, of_several_axes, of_table

__all__ = [
    "APE",
    "Extent",
    "Figures",
    "InTime",
    "Quantiles",
    "Sensitivity",
    "Simulated",
    "Subject",
    "Uncertain",
    "Worst",
    "WorstCase",
    "course",
    "figures",
    "of_coupled_scene",
    "of_scene",
    "of_several_axes",
    "of_table",
    "worst_case",
]
