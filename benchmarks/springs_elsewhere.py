"""Hysteretic springs on two other mirrors than the one they were made for: public oscillators with known equations.

    python benchmarks/springs_elsewhere.py

- Bouc-Wen: m y'' + c y' + k y + z = u with z' = slope y' - decay |y'| z - asymmetry y' |z| (the benchmark of J. Noel
  and M. Schoukens, 2016, with its published numbers), 5 to 150 Hz, a sensor noise of 8 nm;
- Duffing: m y'' + c y' + k y + k3 y^3 = u, a spring that hardens (the Silverbox benchmark's equation, of T. Wigren and
  J. Schoukens, 2013, at the same mass and stiffness).

Each is fitted to three realisations of a random-phase multisine at 10, 25 and 50 N rms, and judged by a realisation
that it has not seen at each of them and at 35 N, which no fit has seen. Rms of the error in % of the output, in the
steady state; "linear" is one linear model of all records, and "own" one that knows the amplitude.
"""

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # as the command line does, before NumPy is loaded

import time
from collections.abc import Callable

import numpy as np

from microrad.core.periodic import delayed
from microrad.lab.identify import fit_hysteretic_stiffness, fit_linear
from microrad.lab.identify.hysteresis.structures import hysteretic_oscillator
from microrad.lab.identify.linear.fit import output_error
from microrad.lab.identify.stiffness.fit import StiffnessOptions, simulate_hysteretic_stiffness
from microrad.lab.recording import Recording
from microrad.mirror import model

RATE_HZ, PERIOD, FINE = 750.0, 4096, 16
SEEN_N, JUDGED_N = (10.0, 25.0, 50.0), (10.0, 25.0, 35.0, 50.0)
MASS, DAMPING, STIFFNESS, CUBIC = 2.0, 10.0, 5e4, 1e8
PUBLISHED = (MASS, DAMPING, STIFFNESS, 5e4, 800.0, -1100.0)
NOISE_M = 8e-9
ORDER = 4


def multisine(seed: int) -> np.ndarray:
    """One period of unit rms."""
    lines = np.fft.rfftfreq(PERIOD, 1 / RATE_HZ)
    phases = np.random.Generator(np.random.Philox(seed)).uniform(0, 2 * np.pi, lines.size)
    drive = np.fft.irfft(np.exp(1j * phases) * ((lines >= 5) & (lines <= 150)), PERIOD)
    return drive[:, None] / drive.std()


def bouc_wen(drive: np.ndarray) -> np.ndarray:
    oscillator = hysteretic_oscillator(*PUBLISHED)
    plant = model.discretise(oscillator.build(np.array(PUBLISHED)), 1 / (FINE * RATE_HZ))
    output = np.empty((len(drive), 1))
    model.respond(plant, model.at_rest(plant), drive, output, np.empty((len(drive), 0)))
    return output


def duffing(drive: np.ndarray) -> np.ndarray:
    """Runge and Kutta's fourth order, the drive straight over each step."""
    step_s, y, v = 1 / (FINE * RATE_HZ), 0.0, 0.0

    def pull(u: float, y: float, v: float) -> float:
        return (u - DAMPING * v - STIFFNESS * y - CUBIC * y**3) / MASS

    output = np.zeros_like(drive)
    values = drive[:, 0].tolist()
    for k in range(1, len(values)):
        begin, end = values[k - 1], values[k]
        middle, half = (begin + end) / 2, step_s / 2
        v1, a1 = v, pull(begin, y, v)
        v2, a2 = v + half * a1, pull(middle, y + half * v1, v + half * a1)
        v3, a3 = v + half * a2, pull(middle, y + half * v2, v + half * a2)
        v4, a4 = v + step_s * a3, pull(end, y + step_s * v3, v + step_s * a3)
        y, v = y + step_s * (v1 + 2 * v2 + 2 * v3 + v4) / 6, v + step_s * (a1 + 2 * a2 + 2 * a3 + a4) / 6
        output[k] = y
    return output


def record(simulate: Callable[[np.ndarray], np.ndarray], amplitude_n: float, seed: int) -> Recording:
    """Two periods in the steady state."""
    drive = amplitude_n * np.tile(multisine(seed), (4, 1))
    output = simulate(delayed(drive, RATE_HZ, 0.0, FINE))[2 * PERIOD * FINE :: FINE]
    noise = np.random.Generator(np.random.Philox(1000 + seed)).standard_normal(output.shape)
    name = f"{amplitude_n:g} N, {seed}"
    return Recording(name, "", drive[2 * PERIOD :], output + NOISE_M * noise, RATE_HZ, ("u",), ("y",), PERIOD)


def share(error: np.ndarray, judged: Recording) -> float:
    return 100.0 * float(np.sqrt(np.mean((error - error.mean()) ** 2)) / judged.output.std())


def main() -> None:
    for name, simulate in (("Bouc-Wen", bouc_wen), ("Duffing", duffing)):
        seen = [[record(simulate, a, 10 * i + k) for k in range(3)] for i, a in enumerate(SEEN_N)]
        every = [r for group in seen for r in group]
        began = time.process_time()
        fit = fit_hysteretic_stiffness(every, order=ORDER, options=StiffnessOptions(sub_steps=4, springs=4))
        spent = time.process_time() - began
        linear = fit_linear(every, ORDER, exchanges=0)
        own = {a: fit_linear(group, ORDER, exchanges=0) for a, group in zip(SEEN_N, seen, strict=True)}
        print(
            f"{name}: {fit.parameters - fit.redundant} numbers, {fit.iterations} steps, softening {fit.softening:.2f}, "
            f"{spent:.0f} s of processor time\n{'rms':>8}{'springs %':>12}{'linear %':>12}{'own %':>12}"
        )
        for seed, amplitude in enumerate(JUDGED_N, 100):
            judged = record(simulate, amplitude, seed)
            modelled = simulate_hysteretic_stiffness(fit, np.tile(judged.drive, (2, 1)))[2 * PERIOD :]
            errors = [share(judged.output - modelled, judged), share(output_error(linear.modes, judged), judged)]
            if amplitude in own:
                errors.append(share(output_error(own[amplitude].modes, judged), judged))
            print(f"{amplitude:6.0f} N" + "".join(f"{e:12.3f}" for e in errors), flush=True)


if __name__ == "__main__":
    main()
