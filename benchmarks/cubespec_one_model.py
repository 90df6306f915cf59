"""One model of the CubeSpec mirror for all three amplitudes, realisations held out in turn.

    python benchmarks/cubespec_one_model.py [fold ... | all] [iterations=N]

A fold holds out one realisation at each amplitude (default: 5) and nothing of it is used, not even for the start. Rms
error over samples and channels as recorded, in um: the two recorded periods simulated one behind the other from rest,
without the first 1000 samples. The published neural model was judged on records that are not here.
"""

import os
import sys
import time
from pathlib import Path

import numpy as np

from microrad.lab.identify import fit_hysteretic_stiffness, predicted_error
from microrad.lab.recording import Recording, multisine_recordings

DATA = Path(os.environ.get("MICRORAD_DATA") or Path(__file__).resolve().parents[2] / "shared" / "data") / "cubespec"
RATE_HZ = 6400.0
ORDER = 28
DROP = 1000
AMPLITUDES_MV = (100, 200, 300)
BARS_UM = (0.10, 0.14, 0.19)
NEURAL_UM = (0.0866, 0.1309, 0.1686)


def realisations(amplitude_mv: int) -> tuple[Recording, ...]:
    drive, output = (np.load(DATA / f"{name}_{amplitude_mv}mV_train.npy") for name in "uy")
    return multisine_recordings(drive, output, RATE_HZ, f"{amplitude_mv} mV")


def rms_um(values: np.ndarray) -> float:
    return 1e6 * float(np.sqrt(np.mean(values**2)))


def row(name: str, errors: tuple[float, ...] | np.ndarray, note: str = "") -> None:
    print(f"{name:24}" + "".join(f"{value:10.4f}" for value in errors) + f"   {note}", flush=True)


def report(done: int, total: int, text: str) -> None:
    print(f"  {done} of {total}: {text}", file=sys.stderr, flush=True)


def fold(records: list[tuple[Recording, ...]], held: int, iterations: int) -> list[float]:
    train = [r for group in records for k, r in enumerate(group) if k != held]
    began = time.perf_counter()
    fit = fit_hysteretic_stiffness(train, order=ORDER, iterations=iterations, on_progress=report)
    seconds = time.perf_counter() - began
    inside = [
        rms_um(np.concatenate([predicted_error(fit, r, DROP) for r in train[5 * k : 5 * k + 5]])) for k in range(3)
    ]
    outside = [rms_um(predicted_error(fit, group[held], DROP)) for group in records]
    row(f"fold {held}, in sample", inside)
    numbers = f"{fit.parameters - fit.redundant} effective of {fit.parameters} numbers, {fit.order} states"
    delay = f"delay {1e6 * fit.delay_s:.1f} us"
    row(f"fold {held}, held out", outside, f"{seconds:.0f} s, {fit.iterations} iterations, {numbers}, {delay}")
    return outside


def main() -> None:
    if not DATA.exists():
        sys.exit(f"the recordings are not at {DATA}; set MICRORAD_DATA")
    options = dict(word.split("=") for word in sys.argv[1:] if "=" in word)
    words = [word for word in sys.argv[1:] if "=" not in word]
    folds = list(range(6)) if words == ["all"] else [int(word) for word in words] or [5]
    records = [realisations(amplitude) for amplitude in AMPLITUDES_MV]
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
