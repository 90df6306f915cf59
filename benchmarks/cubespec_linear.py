"""Linear models of the CubeSpec mirror, one per amplitude, each realisation held out in turn.

    python benchmarks/cubespec_linear.py [exchanges]

Rms error of the held-out realisation over its channels. "from rest" simulates the two recorded periods one behind the
other from rest, without the first 1000 samples; "steady" compares each period with the steady state of its own drive.
The published linear models of order 28 have 0.1142, 0.2161 and 0.2277 um on records that are not here.
"""

import sys
import time

import numpy as np

from cubespec import AMPLITUDES_MV, realisations, rms_um
from microrad.lab.identify.linear.amplitude import amplitude_dependence
from microrad.lab.identify.linear.fit import fit_linear, output_error

ORDER = 28
SETTLED = 1000
BARS_UM = (0.100, 0.170, 0.225)


def main() -> None:
    exchanges = int(sys.argv[1]) if len(sys.argv) > 1 else 12
    fits = []
    print("amplitude  bar     from rest (mean, worst)  steady   in sample   s per fit")
    for amplitude_mv, bar_um, records in zip(AMPLITUDES_MV, BARS_UM, realisations(), strict=True):
        rest, steady, seconds = [], [], []
        for k, held_out in enumerate(records):
            began = time.perf_counter()
            fit = fit_linear([*records[:k], *records[k + 1 :]], ORDER, exchanges=exchanges)
            seconds.append(time.perf_counter() - began)
            rest.append(rms_um(output_error(fit.modes, held_out, drop=SETTLED)))
            steady.append(rms_um(output_error(fit.modes, held_out, steady=True)))
        fits.append(fit_linear(records, ORDER, exchanges=exchanges))
        inside = rms_um(np.concatenate([output_error(fits[-1].modes, r, drop=SETTLED) for r in records]))
        print(
            f"{amplitude_mv} mV     {bar_um:.3f}   {np.mean(rest):.4f}, {max(rest):.4f} um       {np.mean(steady):.4f}"
            f"   {inside:.4f}      {np.mean(seconds):.1f}",
            flush=True,
        )
    change = amplitude_dependence(fits)
    print(f"gain {change.gain_rise_percent:+.1f} %, main resonance {change.resonance_hz.round(1)} Hz")


if __name__ == "__main__":
    main()
