"""One model of the CubeSpec mirror for all three amplitudes, realisations held out in turn.

    python benchmarks/cubespec_one_model.py [fold ... | all] [iterations=N]

A fold holds out one realisation at each amplitude (default: 5) and nothing of it is used, not even for the start.
Errors in um: "in sample" and "held out" are rms over samples and channels, the two recorded periods simulated one
behind the other from rest, without the first 1000 samples; means and bars are of the error as the authors of the
recordings score it (`cubespec.score_um`). The published neural model was judged on records that are not here.
"""

import sys
import time
from functools import partial

import numpy as np
from cubespec import AMPLITUDES_MV, NEURAL_UM, all_but, realisations, rms_um, score_um

from microrad.lab.identify.stiffness.fit import (
    fit_hysteretic_stiffness,
    predicted_error,
    simulate_hysteretic_stiffness,
)
from microrad.lab.recording import Recording

ORDER = 28
SETTLED = 1000
BARS_UM = (0.10, 0.14, 0.19)


def row(name: str, errors: tuple[float, ...] | np.ndarray, note: str = "") -> None:
    print(f"{name:32}" + "".join(f"{value:10.4f}" for value in errors) + f"   {note}", flush=True)


def report(done: int, total: int, text: str) -> None:
    print(f"  {done} of {total}: {text}", file=sys.stderr, flush=True)


def fold(records: list[tuple[Recording, ...]], held: int, iterations: int) -> list[float]:
    train = all_but(records, held)
    began = time.perf_counter()
    fit = fit_hysteretic_stiffness(train, order=ORDER, iterations=iterations, on_progress=report)
    seconds = time.perf_counter() - began
    inside = [
        rms_um(np.concatenate([predicted_error(fit, r, SETTLED) for r in train[5 * k : 5 * k + 5]])) for k in range(3)
    ]
    outside = [rms_um(predicted_error(fit, group[held], SETTLED)) for group in records]
    row(f"fold {held}, in sample", inside)
    numbers = f"{fit.parameters - fit.redundant} effective of {fit.parameters} numbers, {fit.order} states"
    delay = f"delay {1e6 * fit.delay_s:.1f} us"
    row(f"fold {held}, held out", outside, f"{seconds:.0f} s, {fit.iterations} iterations, {numbers}, {delay}")
    simulate = partial(simulate_hysteretic_stiffness, fit)
    scored = [score_um(simulate, group[held]) for group in records]
    row(f"fold {held}, as its authors score", scored)
    return scored


def main() -> None:
    options = dict(word.split("=") for word in sys.argv[1:] if "=" in word)
    words = [word for word in sys.argv[1:] if "=" not in word]
    folds = list(range(6)) if words == ["all"] else [int(word) for word in words] or [5]
    records = realisations()
    row("", AMPLITUDES_MV, "mV rms")
    errors = np.array([fold(records, held, int(options.get("iterations", 40))) for held in folds])
    row(f"mean of {len(folds)}", errors.mean(axis=0))
    row("worst", errors.max(axis=0))
    row("bar", BARS_UM, "met" if (errors.mean(axis=0) <= BARS_UM).all() else "missed")
    row(
        "published neural model",
        NEURAL_UM,
        "beaten" if (errors.mean(axis=0) < NEURAL_UM).all() else "not beaten in all",
    )


if __name__ == "__main__":
    main()
