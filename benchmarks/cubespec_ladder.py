"""The ladder of models on the CubeSpec mirror: held-out error over parameters, and the time of each model.

    python benchmarks/cubespec_ladder.py [held=5]

One realisation at each amplitude is held out and nothing of it is used, not even for a start. Errors in um rms as the
authors of the recordings score (`cubespec.score_um`). "pooled" is what the ladder ranks by, in % of the output. Times
are processor seconds of all threads and, behind them, the clock's: other work on the same machine changes the latter.
"""

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # as the command line does, before NumPy is loaded

import sys
import time

import numpy as np

from cubespec import AMPLITUDES_MV, NEURAL_UM, all_but, realisations, score_um
from microrad.lab.identify.coupled import Candidate, identify_coupled

BARS_UM = (0.10, 0.14, 0.19)
BAR_S = 300.0


def main() -> None:
    options = dict(word.split("=") for word in sys.argv[1:])
    held = int(options.get("held", 5))
    records = realisations()
    train = all_but(records, held)
    last = [time.process_time(), time.perf_counter()]
    began = list(last)
    print(f"{'':34}parameters" + "".join(f"{a:7} mV" for a in AMPLITUDES_MV) + "   pooled %   processor s   clock s")

    def row(name: str, middle: str, errors: tuple[float, ...], end: str = "") -> None:
        print(f"{name:34}{middle:>10}" + "".join(f"{e:10.4f}" for e in errors) + end, flush=True)

    def judged(candidate: Candidate) -> None:
        errors = tuple(score_um(candidate.model.response, group[held]) for group in records)
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
