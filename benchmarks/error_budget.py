"""Seconds of a budget of 300 sources about 3 axes in 6 indices, beside the bar of 0.2 s.

    python benchmarks/error_budget.py

Fifty sources of each class; half of the processes and sinusoids pass a transfer of two states, the others have gains.
The first time counts: nothing is known of the sources before.
"""

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # as the command line does, before NumPy is loaded

import time

import numpy as np

from microrad.core import lti
from microrad.link.error_budget import ErrorSource, Requirement, Spread, budget
from microrad.loop.disturbance import first_order
from microrad.loop.disturbance.windows import ErrorIndex
from recorded import record

BAR_S = 0.2
SOURCES, AXES, REPEATS = 300, 3, 7
INDICES = (
    ErrorIndex("APE"),
    ErrorIndex("MPE", 1.0),
    ErrorIndex("RPE", 1.0),
    ErrorIndex("MPE", 0.01),
    ErrorIndex("RPE", 0.01),
    ErrorIndex("PDE", 1.0, 60.0),
)
KINDS = ("constant", "random", "process", "periodic", "drift", "transient")
THROUGH = lti.StateSpace(
    np.array([[-300.0, -6e4], [1.0, 0.0]]),
    np.array([[1.0], [0.0]]),
    np.array([[300.0, 6e4], [-1.0, 0.0], [0.5, 3.0]]),
    np.zeros((3, 1)),
)


def sources() -> list[ErrorSource]:
    """The same ones each time, made anew: what a source has found out about itself is not kept."""
    draw = np.random.default_rng(1)
    return [source(number, draw) for number in range(SOURCES)]


def source(number: int, draw: np.random.Generator) -> ErrorSource:
    kind = KINDS[number % len(KINDS)]
    gains = draw.normal(size=AXES)
    more = {
        "process": lambda: {"process": first_order(1e-12, draw.uniform(0.1, 100.0), convention="per-axis")},
        "periodic": lambda: {"freq_hz": draw.uniform(0.1, 100.0)},
        "drift": lambda: {"period_s": 5400.0},
        "transient": lambda: {"period_s": 600.0, "decay_s": draw.uniform(1.0, 60.0)},
    }.get(kind, dict)()
    size = {"process": 1.0, "drift": 1e-9}.get(kind, 1e-6)
    spread = Spread("gaussian", 0.0, size) if kind in ("constant", "drift") else Spread("fixed", size)
    through = THROUGH if kind in ("process", "periodic") and number % 4 < 2 else gains
    return ErrorSource(f"{kind} {number}", kind, spread, through, **more)


def main() -> None:
    for interpretation in ("temporal", "mixed"):
        asked = [
            Requirement(
                index,
                axes=(axis,),
                interpretation=interpretation,
                observation_s=61.0 if index.spacing_s else None,
            )
            for index in INDICES
            for axis in range(AXES)
        ]
        budget(sources(), asked)
        took = min(seconds(asked) for _ in range(REPEATS))
        record(f"budget of {SOURCES} sources, {interpretation}", took, "s", at_most=BAR_S)
        over = "" if took <= BAR_S else "  over"
        what = f"{SOURCES} sources, {AXES} axes, {len(INDICES)} indices, {interpretation}"
        print(f"{what:48s} {took:.3f} s, bar {BAR_S} s{over}")


def seconds(asked: list[Requirement]) -> float:
    """How long the budget takes."""
    made = sources()
    began = time.perf_counter()
    budget(made, asked)
    return time.perf_counter() - began


if __name__ == "__main__":
    main()
