"""The CubeSpec recordings, and how their authors score a model of them; for the benchmarks beside it."""

import os
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np

from microrad.lab.recording import Recording, multisine_recordings

DATA = Path(os.environ.get("MICRORAD_DATA") or Path(__file__).resolve().parents[2] / "shared" / "data") / "cubespec"
RATE_HZ = 6400.0
AMPLITUDES_MV = (100, 200, 300)
BEFORE, DROP = 1000, 100  # samples that run before the record, and that each period does without
NEURAL_UM = (0.0866, 0.1309, 0.1686)
"""Of the published neural model, on records that are not here."""


def realisations() -> list[tuple[Recording, ...]]:
    """The six realisations of each amplitude; ends the program where they are not there."""
    if not DATA.exists():
        sys.exit(f"the recordings are not at {DATA}; set MICRORAD_DATA")
    found = []
    for amplitude in AMPLITUDES_MV:
        drive, output = (np.load(DATA / f"{name}_{amplitude}mV_train.npy") for name in "uy")
        found.append(multisine_recordings(drive, output, RATE_HZ, f"{amplitude} mV"))
    return found


def all_but(records: list[tuple[Recording, ...]], held: int) -> list[Recording]:
    """All realisations but one at each amplitude."""
    return [r for group in records for k, r in enumerate(group) if k != held]


def rms_um(values: np.ndarray) -> float:
    return 1e6 * float(np.sqrt(np.mean(values**2)))


def score_um(simulate: Callable[[np.ndarray], np.ndarray], record: Recording) -> float:
    """Error as the authors of the recordings score it.

    The end of both periods runs before them, from zero; the first samples of each period are left out; the mean of the
    rms of each channel and period.
    """
    modelled = simulate(np.concatenate([record.drive[-BEFORE:], record.drive]))[BEFORE:]
    period = record.period_samples or record.samples
    error = (record.output - modelled).reshape(-1, period, record.output.shape[1])[:, DROP:]
    return 1e6 * float(np.sqrt(np.mean(error**2, axis=1)).mean())
