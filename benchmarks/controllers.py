"""What tuned controllers leave on plants with and without a resonance or wheel lines, beside the linear optimum.

    python benchmarks/controllers.py

One axis at 5 kHz with a sample of delay and a 1 kHz amplifier, OLYMPUS (half of it an axis) and 1 µrad of sensor noise,
a modulus margin of at least 0.5. Rms of the residual in µrad, in theory (linear), and the seconds that tuning took.
"""

import math
import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "tests"))

from design_plants import axis_plant
from microrad.loop import control

PLANTS = {
    "plain": {},
    "resonance 300 Hz, damping 0.02": {"resonance": (300.0, 0.02)},
    "resonance 900 Hz, damping 0.02": {"resonance": (900.0, 0.02)},
    "lines of 2 and 1 µrad rms at 80 and 160 Hz": {"lines": ((80.0, 2e-6), (160.0, 1e-6))},
}
FAMILIES = (control.PI, control.PI_NOTCH, control.RESONANT_DAMPING, control.DISTURBANCE_OBSERVER, control.LQG)


def main() -> None:
    wanted = control.Specification(0.5)
    for name, given in PLANTS.items():
        plant = axis_plant(**given)
        families = [*FAMILIES, *([control.peak_family((80.0, 160.0))] if "lines" in given else [])]
        free = control.lqg_controller(plant, control.Weights(1e-6, 1.0, 0.0, 0.0))
        print(f"{name}: optimum {math.sqrt(sum(control.by_source(plant, free).values())) * 1e6:.3f}")
        for family in families:
            began = time.perf_counter()
            tuned = control.tune(family, [plant], wanted, seed=1)
            took = time.perf_counter() - began
            left, margin = tuned.residual_rms_rad * 1e6, tuned.margins.modulus
            print(f"  {family.name:22} {left:.3f}  margin {margin:.3f}  {took:.1f} s")


if __name__ == "__main__":
    main()
