"""One model of the CubeSpec mirror for all three amplitudes, realisations held out in turn.

    python benchmarks/cubespec_one_model.py [fold ... | all] [order=36] [springs=6,12] [seen=100,200,300]
        [iterations=60]

A fold holds out one realisation at each amplitude (default: 5), and nothing of it is used: not for the start, not for
the choice of the number of springs. Where several are given, each is fitted with few steps to all but one of the fold's
own realisations and judged by that one ("inner"); the best is fitted to all of them. With "seen" only those amplitudes
are fitted, and the others are blind.

Errors in um as the authors of the recordings score them (`cubespec.score_um`), and below them pooled: rms over samples
and channels, both periods from rest, without the first 1000 samples. Bars: at most 40 states and at most 28. The
published neural model was judged on records that are not here.
"""

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # as the command line does, before NumPy is loaded

import sys
import time
from functools import partial

import numpy as np
from cubespec import AMPLITUDES_MV, NEURAL_UM, realisations, rms_um, score_um

from microrad.lab.identify.stiffness.fit import (
    HystereticStiffnessFit,
    StiffnessOptions,
    fit_hysteretic_stiffness,
    predicted_error,
    simulate_hysteretic_stiffness,
)
from microrad.lab.recording import Recording

SETTLED = 1000
INNER = 10  # steps of a fit that only chooses
BARS_UM = {40: (0.065, 0.105, 0.160), 28: (0.068, 0.110, 0.170)}
STRETCH_UM = (0.055, 0.095, 0.145)
Groups = list[tuple[Recording, ...]]


def row(name: str, errors: tuple[float, ...] | np.ndarray, note: str = "") -> None:
    print(f"{name:34}" + "".join(f"{value:10.4f}" for value in errors) + f"   {note}", flush=True)


def without(groups: Groups, held: int) -> Groups:
    return [tuple(r for k, r in enumerate(group) if k != held) for group in groups]


def scores(fit: HystereticStiffnessFit, groups: Groups, held: int) -> np.ndarray:
    return np.array([score_um(partial(simulate_hysteretic_stiffness, fit), group[held]) for group in groups])


def fitted(groups: Groups, order: int, springs: int, iterations: int) -> HystereticStiffnessFit:
    def report(done: int, total: int, text: str) -> None:
        print(f"  {done} of {total}: {text}", file=sys.stderr, flush=True)

    records = [r for group in groups for r in group]
    options = StiffnessOptions(springs=springs)
    return fit_hysteretic_stiffness(records, order=order, options=options, iterations=iterations, on_progress=report)


def chosen(groups: Groups, order: int, candidates: list[int]) -> int:
    """The number of springs that serves best on a realisation of the fold's own."""
    if len(candidates) == 1:
        return candidates[0]
    errors = []
    for springs in candidates:
        fit = fitted(without(groups, 0), order, springs, INNER)
        errors.append(scores(fit, groups, 0))
        row(f"  inner, {springs} springs", errors[-1], f"{fit.parameters - fit.redundant} numbers")
    return candidates[int(np.argmin(np.log(errors).sum(axis=1)))]


def fold(groups: Groups, held: int, options: dict[str, str]) -> np.ndarray:
    seen = [AMPLITUDES_MV.index(int(a)) for a in options["seen"].split(",")]
    train, order = [without(groups, held)[k] for k in seen], int(options["order"])
    began, spent = time.perf_counter(), time.process_time()
    springs = chosen(train, order, [int(n) for n in options["springs"].split(",")])
    choosing = time.process_time() - spent
    fit = fitted(train, order, springs, int(options["iterations"]))
    seconds, of_processor = time.perf_counter() - began, time.process_time() - spent - choosing
    numbers = f"{fit.parameters - fit.redundant} numbers, {fit.order} states, {springs} springs"
    steps = f"{fit.iterations} steps{'' if fit.converged else ', the most'}, softening {fit.softening:.2f}"
    spent_on = f"{seconds:.0f} s in all; of processor time {of_processor:.0f} s and {choosing:.0f} s to choose"
    scored = scores(fit, groups, held)
    row(f"fold {held}, held out", scored, f"{numbers}, {steps}; {spent_on}")
    pooled = [rms_um(predicted_error(fit, group[held], SETTLED)) for group in groups]
    row(f"fold {held}, pooled", np.array(pooled))
    return scored


def main() -> None:
    options = {"order": "36", "springs": "6,12", "seen": "100,200,300", "iterations": "60"}
    options |= dict(word.split("=") for word in sys.argv[1:] if "=" in word)
    words = [word for word in sys.argv[1:] if "=" not in word]
    folds = list(range(6)) if words == ["all"] else [int(word) for word in words] or [5]
    groups = realisations()
    row("", AMPLITUDES_MV, "mV rms")
    errors = np.array([fold(groups, held, options) for held in folds])
    row(f"mean of {len(folds)}", errors.mean(axis=0))
    row("worst", errors.max(axis=0))
    bars = BARS_UM[28 if int(options["order"]) <= 28 else 40]
    for name, bar in (("bar", bars), ("stretch", STRETCH_UM), ("published neural model", NEURAL_UM)):
        row(name, bar, "met" if (errors.mean(axis=0) <= bar).all() else "missed")


if __name__ == "__main__":
    main()
