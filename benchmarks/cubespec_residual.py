"""What one model of the CubeSpec mirror leaves of a realisation that it has not seen, beside noise and distortion.

    python benchmarks/cubespec_residual.py [held=5] [order=36] [springs=12] [iterations=60]

Rms in um over the channels, of the mean of both periods in the steady state, by amplitude and band of frequencies:

- model: what hysteretic stiffness leaves, one model for all amplitudes;
- linear: what the best linear response of each amplitude by itself leaves, line by line and of no order, from the
  scatter of the other realisations about it;
- noise: what changes from one period to the next, of a mean of two.

What "linear" has above the noise is the distortion by hysteresis and whatever else is not linear: a model for all
amplitudes can only go below it by knowing that distortion. Every line from 0.78 to 2999 Hz is excited, so that odd and
even distortions cannot be told apart inside the band; beyond it nothing is excited.
"""

import sys
from itertools import pairwise

import numpy as np

from cubespec import AMPLITUDES_MV, RATE_HZ, all_but, realisations
from microrad.lab.identify.linear.response import response_from_periods
from microrad.lab.identify.stiffness.fit import (
    StiffnessOptions,
    fit_hysteretic_stiffness,
    simulate_hysteretic_stiffness,
)
from microrad.lab.recording import Recording

EDGES_HZ = (0.5, 500.0, 930.0, 1000.0, 1500.0, 1700.0, 2200.0, 2500.0, 3000.0, 3200.5)


def power(values: np.ndarray) -> np.ndarray:
    """Mean square of one period at each of its lines."""
    return 2.0 * np.abs(np.fft.rfft(values, axis=0) / len(values)) ** 2


def left(fit, group: tuple[Recording, ...], held: int) -> tuple[np.ndarray, ...]:
    """Powers of what the model leaves of a realisation, of what is not linear in the others, and of the noise."""
    record, others = group[held], [r for k, r in enumerate(group) if k != held]
    first, second = record.output.reshape(2, -1, record.output.shape[1])
    steady = simulate_hysteretic_stiffness(fit, np.concatenate([record.drive, record.drive]))[-len(first) :]
    found = response_from_periods(others, skip_periods=0)
    linear = np.zeros((len(first) // 2 + 1, record.output.shape[1]))
    linear[np.rint(found.freq_hz * len(first) / RATE_HZ).astype(int)] = found.residual_power
    return power((first + second) / 2 - steady), linear, power(second - first) / 4


def main() -> None:
    options = {"held": 5, "order": 36, "springs": 12, "iterations": 60}
    options |= {key: int(value) for key, value in (word.split("=") for word in sys.argv[1:])}
    records = realisations()
    fit = fit_hysteretic_stiffness(
        all_but(records, options["held"]),
        order=options["order"],
        options=StiffnessOptions(springs=options["springs"]),
        iterations=options["iterations"],
        on_progress=lambda done, total, text: print(f"  {done} of {total}: {text}", file=sys.stderr, flush=True),
    )
    freq_hz = np.fft.rfftfreq(records[0][0].period_samples or 0, 1 / RATE_HZ)
    print(f"order {fit.order}, {fit.parameters - fit.redundant} numbers")
    print(f"{'um':20}" + "".join(f"{f'{a} mV: model':>16}{'linear':>9}{'noise':>9}" for a in AMPLITUDES_MV))
    spectra = [left(fit, group, options["held"]) for group in records]

    def row(name: str, used: np.ndarray | slice, channels: slice = slice(None)) -> None:
        errors = [[1e6 * np.sqrt(np.mean(np.sum(s[used, channels], axis=0))) for s in own] for own in spectra]
        print(f"{name:20}" + "".join(f"{m:16.4f}{b:9.4f}{n:9.4f}" for m, b, n in errors), flush=True)

    row("all", slice(1, None))
    for k in range(records[0][0].output.shape[1]):
        row(f"channel {k + 1}", slice(1, None), slice(k, k + 1))
    for low, high in pairwise(EDGES_HZ):
        row(f"{low:.0f} to {high:.0f} Hz", (freq_hz >= low) & (freq_hz < high))


if __name__ == "__main__":
    main()
