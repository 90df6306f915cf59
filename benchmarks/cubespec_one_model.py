"""One model of the CubeSpec mirror for all three amplitudes, realisations held out in turn.

    python benchmarks/cubespec_one_model.py [fold ... | all] [order=28,36] [springs=12] [thresholds=0.02:0.06:0.15:0.4]
        [seen=100,200,300] [iterations=60]

A fold holds out one realisation at each amplitude (default: 5), and nothing of it is used: not for the start, and not
for a choice. Where several orders, numbers of springs or sets of thresholds are given, separated by commas, each is
fitted to the fold's own records, and the one counts that is expected to leave least of an unseen one
(`unseen_error_rms` of the fit, from the same records; geometric mean over the amplitudes). What all of them leave is
shown beside it. With "seen" only those amplitudes are fitted, and the others are blind.

Errors in um as the authors of the recordings score them (`cubespec.score_um`), and below them pooled: rms over samples
and channels, both periods from rest, without the first 1000 samples. Bars: at most 40 states and at most 28. The
published neural model was judged on records that are not here.
"""

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # as the command line does, before NumPy is loaded

import sys
import time
from functools import partial
from itertools import product

import numpy as np

from cubespec import AMPLITUDES_MV, NEURAL_UM, realisations, rms_um, score_um
from microrad.lab.identify.stiffness.fit import (
    THRESHOLDS,
    HystereticStiffnessFit,
    StiffnessOptions,
    fit_hysteretic_stiffness,
    predicted_error,
    simulate_hysteretic_stiffness,
)
from microrad.lab.recording import Recording

SETTLED = 1000
BARS_UM = {40: (0.065, 0.105, 0.160), 28: (0.068, 0.110, 0.170)}
STRETCH_UM = (0.055, 0.095, 0.145)
Groups = list[tuple[Recording, ...]]


def row(name: str, errors: tuple[float, ...] | np.ndarray, note: str = "") -> None:
    print(f"{name:42}" + "".join(f"{value:10.4f}" for value in errors) + f"   {note}", flush=True)


def without(groups: Groups, held: int) -> Groups:
    return [tuple(r for k, r in enumerate(group) if k != held) for group in groups]


def scores(fit: HystereticStiffnessFit, groups: Groups, held: int) -> np.ndarray:
    return np.array([score_um(partial(simulate_hysteretic_stiffness, fit), group[held]) for group in groups])


def fitted(groups: Groups, order: int, options: StiffnessOptions, iterations: int) -> HystereticStiffnessFit:
    def report(done: int, total: int, text: str) -> None:
        print(f"  {done} of {total}: {text}", file=sys.stderr, flush=True)

    records = [r for group in groups for r in group]
    return fit_hysteretic_stiffness(records, order=order, options=options, iterations=iterations, on_progress=report)


def expected_um(fit: HystereticStiffnessFit) -> np.ndarray:
    """What the fit is expected to leave of an unseen record of each amplitude, by its own records."""
    classes = np.asarray(fit.classes)
    return np.array([rms_um(fit.unseen_error_rms[classes == c]) for c in range(len(fit.amplitudes))])


def fold(groups: Groups, held: int, options: dict[str, str]) -> np.ndarray:
    seen = [AMPLITUDES_MV.index(int(a)) for a in options["seen"].split(",")]
    train = [without(groups, held)[k] for k in seen]
    best, scored, least = None, np.full(len(groups), np.nan), np.inf
    candidates = product(*(options[key].split(",") for key in ("order", "springs", "thresholds")))
    for order, springs, thresholds in candidates:
        chosen = StiffnessOptions(springs=int(springs), thresholds=tuple(float(r) for r in thresholds.split(":")))
        began, spent = time.perf_counter(), time.process_time()
        fit = fitted(train, int(order), chosen, int(options["iterations"]))
        seconds, of_processor = time.perf_counter() - began, time.process_time() - spent
        steps = f"{fit.iterations} steps{'' if fit.converged else ', the most'}, softening {fit.softening:.2f}"
        expected = np.full(len(groups), np.nan)
        expected[seen] = expected_um(fit)
        told = f"{fit.parameters - fit.redundant} numbers, {steps}; {seconds:.0f} s, of processors {of_processor:.0f} s"
        row(f"  {order}, {springs}, {thresholds}: expected", expected, told)
        row("    held out", held_out := scores(fit, groups, held))
        if (mean := float(np.log(expected[seen]).mean())) < least:
            best, scored, least = fit, held_out, mean
    assert best is not None
    row(f"fold {held}, held out", scored, f"{best.parameters - best.redundant} numbers, {best.order} states")
    pooled = [rms_um(predicted_error(best, group[held], SETTLED)) for group in groups]
    row(f"fold {held}, pooled", np.array(pooled))
    return scored


def main() -> None:
    options = {
        "order": "28,36",
        "springs": "12",
        "thresholds": ":".join(f"{r:g}" for r in THRESHOLDS),
        "seen": "100,200,300",
        "iterations": "60",
    }
    options |= dict(word.split("=") for word in sys.argv[1:] if "=" in word)
    words = [word for word in sys.argv[1:] if "=" not in word]
    folds = list(range(6)) if words == ["all"] else [int(word) for word in words] or [5]
    groups = realisations()
    row("", AMPLITUDES_MV, "mV rms")
    errors = np.array([fold(groups, held, options) for held in folds])
    row(f"mean of {len(folds)}", errors.mean(axis=0))
    row("worst", errors.max(axis=0))
    bars = BARS_UM[28 if max(int(n) for n in options["order"].split(",")) <= 28 else 40]
    for name, bar in (("bar", bars), ("stretch", STRETCH_UM), ("published neural model", NEURAL_UM)):
        row(name, bar, "met" if (errors.mean(axis=0) <= bar).all() else "missed")


if __name__ == "__main__":
    main()
