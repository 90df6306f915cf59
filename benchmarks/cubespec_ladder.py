"""The ladder of models on the CubeSpec mirror: held-out error over parameters, and the time of each model.

    python benchmarks/cubespec_ladder.py [held=5]

One realisation at each amplitude is held out and nothing of it is used, not even for a start. Errors in um rms as the
authors of the recordings score: the last 1000 samples of both periods run before them, from zero; the first 100 samples
of each period are left out; rms of each channel and period, and the mean of these. "pooled" is what the ladder ranks
by, in % of the output. Times are processor seconds of all threads and, behind them, the clock's: other work on the
same machine changes the latter.
"""

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # as the command line does, before NumPy is loaded

import sys
import time
from pathlib import Path

import numpy as np

from microrad.lab.identify.coupled import Candidate, identify_coupled
from microrad.lab.recording import Recording, multisine_recordings

DATA = Path(os.environ.get("MICRORAD_DATA") or Path(__file__).resolve().parents[2] / "shared" / "data") / "cubespec"
RATE_HZ, BEFORE, DROP = 6400.0, 1000, 100
AMPLITUDES_MV = (100, 200, 300)
BARS_UM = (0.10, 0.14, 0.19)
NEURAL_UM = (0.0866, 0.1309, 0.1686)
BAR_S = 300.0


def realisations(amplitude_mv: int) -> tuple[Recording, ...]:
    drive, output = (np.load(DATA / f"{name}_{amplitude_mv}mV_train.npy") for name in "uy")
    return multisine_recordings(drive, output, RATE_HZ, f"{amplitude_mv} mV")


def score_um(candidate: Candidate, record: Recording) -> float:
    modelled = candidate.model.response(np.concatenate([record.drive[-BEFORE:], record.drive]))[BEFORE:]
    period = record.period_samples or record.samples
    error = (record.output - modelled).reshape(-1, period, record.output.shape[1])[:, DROP:]
    return 1e6 * float(np.sqrt(np.mean(error**2, axis=1)).mean())


def main() -> None:
    if not DATA.exists():
        sys.exit(f"the recordings are not at {DATA}; set MICRORAD_DATA")
    options = dict(word.split("=") for word in sys.argv[1:])
    held = int(options.get("held", 5))
    records = [realisations(amplitude) for amplitude in AMPLITUDES_MV]
    train = [r for group in records for k, r in enumerate(group) if k != held]
    last = [time.process_time(), time.perf_counter()]
    began = list(last)
    print(f"{'':34}parameters" + "".join(f"{a:7} mV" for a in AMPLITUDES_MV) + "   pooled %   processor s   clock s")

    def row(name: str, middle: str, errors: tuple[float, ...], end: str = "") -> None:
        print(f"{name:34}{middle:>10}" + "".join(f"{e:10.4f}" for e in errors) + end, flush=True)

    def judged(candidate: Candidate) -> None:
        errors = tuple(score_um(candidate, group[held]) for group in records)
        now = [time.process_time(), time.perf_counter()]
        spent = "".join(f"{a - b:12.1f}" for a, b in zip(now, last, strict=True))
        row(candidate.name, str(candidate.parameters), errors, f"{100 * candidate.error_share:11.2f}{spent}")
        last[:] = time.process_time(), time.perf_counter()

    found = identify_coupled(train, validation=[group[held] for group in records], on_model=judged)
    spent = [a - b for a, b in zip((time.process_time(), time.perf_counter()), began, strict=True)]
    row("bar", "", BARS_UM)
    row("published neural model", "", NEURAL_UM, "   on records that are not here")
    print(f"{found.reason}\nrefused: {found.refused}")
    for warning in found.warnings:
        print(warning)
    own = found.candidate()
    print(f"delay {1e6 * own.model.delay_s:.2f} +/- {1e6 * own.delay_error_s:.2f} us")
    for pole, error in zip(own.poles_rad_s / (2 * np.pi), own.poles_error_rad_s / (2 * np.pi), strict=True):
        print(f"pole {pole.real:8.3f} +/- {error.real:.3f}, {pole.imag:9.3f} +/- {error.imag:.3f} Hz")
    print(
        f"in all {spent[0]:.0f} processor s, {spent[1]:.0f} s by the clock (bar: {BAR_S:.0f} s on two cores of its own)"
    )


if __name__ == "__main__":
    main()
