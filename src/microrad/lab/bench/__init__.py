"""Excitation design and the virtual bench: a plan file becomes drives within limits, and drives become recordings.

    plan = load_plan("mirror-characterisation")      # a packaged plan, or the path of a file
    recordings = play(plan, seed=1)                  # one Recording a record, V and mrad
    files = write(plan, "records", seed=1)           # the same as a folder of lab files

The bench's own mirror is none of the models that `identify` fits; it can play Eq. 2 and Eq. 3 of SPIE 11852, 118523B
as well. This package stands below identification: it knows nothing of it.
"""

from microrad.lab.bench.excitation import (
    DesignError,
    Excitation,
    Limits,
    Lines,
    growing_sines,
    log_spaced,
    logarithmic_chirp,
    multisine,
    staircase,
)
from microrad.lab.bench.files import check_folder, read_folder, write
from microrad.lab.bench.plan import FORMATS, TRUTHS, Plan, Record, only, with_truth
from microrad.lab.bench.planfile import PlanError, load_plan, packaged_plans
from microrad.lab.bench.play import BenchError, play, played, true_output
from microrad.lab.bench.truth import Amplifier, BenchMirror, bench_output, bouc_wen_output, linear_output

__all__ = [
    "FORMATS",
    "TRUTHS",
    "Amplifier",
    "BenchError",
    "BenchMirror",
    "DesignError",
    "Excitation",
    "Limits",
    "Lines",
    "Plan",
    "PlanError",
    "Record",
    "bench_output",
    "bouc_wen_output",
    "check_folder",
    "growing_sines",
    "linear_output",
    "load_plan",
    "log_spaced",
    "logarithmic_chirp",
    "multisine",
    "only",
    "packaged_plans",
    "play",
    "played",
    "read_folder",
    "staircase",
    "true_output",
    "with_truth",
    "write",
]
