"""Linear models of the CubeSpec mirror, one per amplitude, each realisation held out in turn.

    python benchmarks/cubespec_linear.py [exchanges]

Rms error of the held-out realisation over its channels. "from rest" simulates the two recorded periods one behind the
other from rest, without the first 1000 samples; "steady" compares each period with the steady state of its own drive.
The published linear models of order 28 have 0.1142, 0.2161 and 0.2277 um on records that are not here.
"""

import os
import sys
import time
from pathlib import Path

import numpy as np

from microrad.lab.identify.linear.amplitude import amplitude_dependence
from microrad.lab.identify.linear.fit import fit_linear, output_error
from microrad.lab.recording import Recording, multisine_recordings

DATA = Path(os.environ.get("MICRORAD_DATA") or Path(__file__).resolve().parents[2] / "shared" / "data") / "cubespec"
RATE_HZ = 6400.0
ORDER = 28
DROP = 1000


def realisations(amplitude_mv: int) -> tuple[Recording, ...]:
    drive, output = (np.load(DATA / f"{name}_{amplitude_mv}mV_train.npy") for name in "uy")
    return multisine_recordings(drive, output, RATE_HZ, f"{amplitude_mv} mV")


def rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2)))


def main() -> None:
    if not DATA.exists():
        sys.exit(f"the recordings are not at {DATA}; set MICRORAD_DATA")
    exchanges = int(sys.argv[1]) if len(sys.argv) > 1 else 12
    fits = []
    print("amplitude  bar     from rest (mean, worst)  steady   in sample   s per fit")
    for amplitude_mv, bar_um in ((100, 0.100), (200, 0.170), (300, 0.225)):
        records = realisations(amplitude_mv)
        rest, steady, seconds = [], [], []
        for k, held_out in enumerate(records):
            began = time.perf_counter()
            fit = fit_linear([*records[:k], *records[k + 1 :]], ORDER, exchanges=exchanges)
            seconds.append(time.perf_counter() - began)
            rest.append(1e6 * rms(output_error(fit.modes, held_out, drop=DROP)))
            steady.append(1e6 * rms(output_error(fit.modes, held_out, steady=True)))
        fits.append(fit_linear(records, ORDER, exchanges=exchanges))
        inside = 1e6 * rms(np.concatenate([output_error(fits[-1].modes, r, drop=DROP) for r in records]))
        print(
            f"{amplitude_mv} mV     {bar_um:.3f}   {np.mean(rest):.4f}, {max(rest):.4f} um       {np.mean(steady):.4f}"
            f"   {inside:.4f}      {np.mean(seconds):.1f}",
            flush=True,
        )
    change = amplitude_dependence(fits)
    print(f"gain {change.gain_rise_percent:+.1f} %, main resonance {change.resonance_hz.round(1)} Hz")


if __name__ == "__main__":
    main()
