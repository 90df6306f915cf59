"""One model of the CubeSpec mirror fitted to all of its recordings, and what it says of others, as arrays like theirs.

    python benchmarks/cubespec_submission.py FOLDER [order=36] [springs=12]

For each amplitude FOLDER gets ``y_{amplitude}mV_model.npy``, of the shape of the recordings (samples, channels,
realisations, periods) and in metres: the model's output for ``u_{amplitude}mV_test.npy`` where that lies beside the
recordings, else for the training record. The mirror stands there as ``mirror.toml``. What is printed in the end are the
errors to submit: in um, as the authors score (`cubespec.score_um`), of the test records where their outputs are there.
"""

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # as the command line does, before NumPy is loaded

import sys
from functools import partial
from pathlib import Path

import numpy as np

from cubespec import AMPLITUDES_MV, BEFORE, DATA, RATE_HZ, realisations, score_um
from microrad.lab.identify.stiffness.fit import (
    HystereticStiffnessFit,
    StiffnessOptions,
    fit_hysteretic_stiffness,
    simulate_hysteretic_stiffness,
)
from microrad.lab.recording import multisine_recordings
from microrad.mirror import coupled


def modelled(fit: HystereticStiffnessFit, drive: np.ndarray) -> np.ndarray:
    """Output of the model: of each realisation the end of both periods runs before them, from zero."""
    samples, channels, count, periods = drive.shape
    output = np.empty_like(drive)
    for k in range(count):
        stacked = drive[:, :, k].transpose(2, 0, 1).reshape(periods * samples, channels)
        found = simulate_hysteretic_stiffness(fit, np.concatenate([stacked[-BEFORE:], stacked]))[BEFORE:]
        output[:, :, k] = found.reshape(periods, samples, channels).transpose(1, 2, 0)
    return output


def mirror_file(fit: HystereticStiffnessFit, drive_v: np.ndarray) -> str:
    limit, rate = float(np.abs(drive_v).max()), float(np.abs(np.diff(drive_v, axis=0)).max() * RATE_HZ)
    actuators = tuple(coupled.Actuator(f"u{i + 1}", 0.0, -limit, limit, rate) for i in range(fit.mirror.actuators))
    outputs = tuple(coupled.Output(f"y{i + 1}", "displacement") for i in range(fit.mirror.axes))
    sampling = fit.delay_s, fit.rate_hz, fit.sub_steps
    return coupled.text(coupled.CoupledMirror(fit.mirror, actuators, outputs, *sampling, (0.78125, 2999.2)))


def main() -> None:
    folder, *words = sys.argv[1:] or sys.exit(__doc__)
    options = {"order": 36, "springs": 12} | {key: int(v) for key, v in (word.split("=") for word in words)}
    into, train = Path(folder), realisations()
    into.mkdir(parents=True, exist_ok=True)
    fit = fit_hysteretic_stiffness(
        [r for group in train for r in group],
        order=options["order"],
        options=StiffnessOptions(springs=options["springs"]),
        on_progress=lambda done, total, text: print(f"  {done} of {total}: {text}", file=sys.stderr, flush=True),
    )
    scores, kinds = [], []
    for amplitude, group in zip(AMPLITUDES_MV, train, strict=True):
        kind = "test" if (DATA / f"u_{amplitude}mV_test.npy").exists() else "train"
        drive, judged = np.load(DATA / f"u_{amplitude}mV_{kind}.npy"), group
        if kind == "test" and (outputs := DATA / f"y_{amplitude}mV_test.npy").exists():
            judged = multisine_recordings(drive, np.load(outputs), RATE_HZ, f"{amplitude} mV, test")
        np.save(into / f"y_{amplitude}mV_model.npy", modelled(fit, drive))
        scores.append(np.mean([score_um(partial(simulate_hysteretic_stiffness, fit), r) for r in judged]))
        kinds.append("test" if judged is not group else "training")
    largest = np.concatenate([r.drive for group in train for r in group])
    (into / "mirror.toml").write_text(mirror_file(fit, largest), encoding="utf-8")
    numbers = fit.parameters - fit.redundant
    print(f"order {fit.order}, {numbers} numbers; judged by {', '.join(dict.fromkeys(kinds))} records")
    print(f"RMSE to submit = [{'; '.join(f'{score:.4f}' for score in scores)}] um")


if __name__ == "__main__":
    main()
