"""The adaptive inverse against its three bars, beside the frozen one in the same run.

    python benchmarks/adaptive_inverse.py [mirrors]

1. An inverse alone straightens a mirror of plays that has lost 20 % of its gain, whose loops are 30 % wider and which
   creeps, in ordinary jitter (OLYMPUS, and a body of 100 urad rms at 0.1 Hz): error against a mirror without
   hysteresis, in per cent of the target's peak-to-peak in the first 2 s, over 64 runs. The loops are wider by the
   plays' weights, or by their thresholds.
2. 64 runs of 4 s on each of so many random mirrors (160: 10240 runs) in the PI's loop: rms of each second.
3. Time of a step of exported C for two axes, the least of many passes in turn.
"""

import ctypes
import subprocess
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

from microrad import mirror
from microrad.core import kernels, lti
from microrad.export import choice, records
from microrad.export.flight.c_code import flight_code
from microrad.export.linear_part.sections import sections
from microrad.loop import control, disturbance
from microrad.loop.pointing_loop import kernel_arrays
from microrad.loop.pointing_loop import loop as fine
from microrad.loop.pointing_loop.design import behind_filter, design_plant
from microrad.loop.pointing_loop.traces import replay
from microrad.loop.sensor import OpticalSensor, StrainGauge
from microrad.mirror.hysteresis import NO_CREEP, Creep, PrandtlIshlinskii

RATE_HZ = 5000
GAIN = 89e-6
PLAYS = PrandtlIshlinskii(
    (0.0, 0.05, 0.1, 0.2, 0.4, 0.7, 1.1, 1.6), tuple(GAIN * w for w in (0.6, 0.06, 0.06, 0.07, 0.07, 0.05, 0.05, 0.04))
)
CREEP = Creep((1e-6, 1e-6, 1e-6), (0.1, 1.0, 10.0))
FILTER = fine.ReferenceFilter(1000.0)
NOTHING = np.empty((0, 0, 0))


def changed(gain: float, width: float = 1.0, stretch: float = 1.0) -> PrandtlIshlinskii:
    """The plays with another gain, loops wider by the weights beyond the first, and thresholds times a factor."""
    weights = np.array(PLAYS.weights_rad_v)
    weights[1:] *= width
    weights[0] = sum(PLAYS.weights_rad_v) - weights[1:].sum()
    return PrandtlIshlinskii(tuple(stretch * r for r in PLAYS.thresholds_v), tuple((gain * weights).tolist()))


def loop_of(
    model: PrandtlIshlinskii, creep: Creep = NO_CREEP, axes: int = 1, jitter: float = 1.0, body: float = 1.0
) -> fine.PointingLoop:
    """A fine-pointing loop as the shipped mission's, around a mirror of plays."""
    one = mirror.model.assemble("plays", "static", None, model, creep)
    vibration = disturbance.olympus()
    shaken = (replace(vibration, C=jitter * vibration.C), disturbance.body_pointing(100e-6 * body, 1.0, 0.1))
    return fine.PointingLoop(
        mirror=mirror.combine(*[one] * axes),
        optics=np.eye(axes),
        drive=control.Drive(-6.0, 6.0, 1e3, 1e6 / 15.0, 0.305e-3, 0.0),
        timing=control.Timing(1.0 / RATE_HZ, 5, 5),
        disturbances=(shaken,) * axes,
        optical=OpticalSensor(1e-6, 2e-3, 0.12e-6, 1, 0),
        gauge=StrainGauge(0.1e-6, 0.027e-6),
        references=(disturbance.Reference(0.0, 0.0, 1.0),) * axes,
    )


def both(loop: fine.PointingLoop, axis: control.AxisController) -> dict[str, fine.LoopController]:
    """The axis controller with the frozen inverse in series, and with the adaptive one."""
    frozen = fine.with_inverse("in series", loop, axis, control.inverse(loop.mirror), FILTER, True)
    return {"frozen": frozen, "adaptive": fine.with_adaptation(frozen, loop)}


def open_axis() -> control.AxisController:
    """No feedback: the inverse of the reference alone."""
    nothing = lti.StateSpace(np.zeros((0, 0)), np.zeros((0, 2)), np.zeros((1, 0)), np.zeros((1, 2)))
    return control.AxisController("open", nothing, np.zeros((0, 1)))


def tuned_axis() -> control.AxisController:
    """The PI of the study, tuned behind the reference filter."""
    plant = behind_filter(design_plant(loop_of(PLAYS)), FILTER.discrete(1.0 / RATE_HZ))
    return control.tune(control.PI, [plant], control.Specification(0.5), seed=1).controller


def advance(
    loop: fine.PointingLoop, made: fine.LoopController, seed: int, reference: np.ndarray
) -> tuple[np.ndarray, ...]:
    """Residual and mirror of 64 runs of one axis, (samples, LANES) each, and the counts."""
    p = kernel_arrays.arrays(loop, made, seed)
    state, samples = kernel_arrays.start(loop, p, 0), len(reference) - 1
    residual = np.empty((samples, 1, kernels.LANES))
    trace = np.empty((samples, 1 + kernels.DRIVE_FIELDS + 1 + p.B.shape[1], kernels.LANES))
    kernels.ensemble_loop(p, state, reference, residual, trace, kernels.UNSHIFTED)
    return residual[:, 0], trace[:, 1 + kernels.DRIVE_FIELDS], state.counts.reshape(-1, kernels.LANES)


def straightening() -> None:
    """Bar 1: the error of the inverse alone, half a second at a time."""
    seconds, nominal = 4, loop_of(PLAYS)
    idle = fine.LoopController(
        "idle", lti.StateSpace(np.zeros((0, 0)), np.zeros((0, 3)), np.zeros((1, 0)), np.zeros((1, 3))), np.zeros((0, 1))
    )
    quiet = replace(nominal, optical=replace(nominal.optical, noise_rad=0.0, field_of_view_rad=1.0))
    shaking = advance(quiet, idle, 1, np.zeros((seconds * RATE_HZ + 1, 1, 1)))[0]
    target = np.ascontiguousarray(np.vstack([shaking, shaking[-1:]])[:, None] - shaking[0])
    peak_to_peak = np.ptp(target[: 2 * RATE_HZ, 0], axis=0)
    still = replace(quiet, disturbances=((),))
    ideal = replace(fine.without_hysteresis(still), drive=replace(still.drive, drive_resolution_v=0.0))
    wanted = advance(ideal, both_open(ideal)["frozen"], 1, target)[1]
    for words, model in {"weights": changed(0.8, 1.3), "thresholds": changed(0.8, stretch=1.3)}.items():
        for name, made in both_open(still).items():
            softer = replace(still, mirror=loop_of(model, CREEP).mirror)
            off = 100.0 * (advance(softer, made, 1, target)[1] - wanted) / peak_to_peak
            parts = off.reshape(2 * seconds, -1, kernels.LANES)
            rms, peak = np.sqrt(np.mean(parts**2, axis=1)), np.max(np.abs(parts), axis=1)
            shown = ", ".join(f"{np.median(r):.2f} ({np.max(r):.2f})" for r in rms)
            print(f"wider {words:10} {name:8} rms % of peak-to-peak, median (worst) of each half second: {shown}")
            print(f"{'':27} peak from 1.5 s to 2 s: median {np.median(peak[3]):.2f}, worst {np.max(peak[3]):.2f}")


def both_open(loop: fine.PointingLoop) -> dict[str, fine.LoopController]:
    """The inverses without feedback; on a mirror without plays the frozen one alone."""
    if loop.mirror.plays:
        return both(loop, open_axis())
    return {"frozen": fine.with_inverse("open", loop, open_axis(), control.inverse(loop.mirror), FILTER, True)}


def scenarios(mirrors: int) -> None:
    """Bar 2: seconds of the adaptive inverse over those of the frozen one, in the same jitter."""
    made, ratios, fallbacks = both(loop_of(PLAYS), tuned_axis()), [], 0.0
    for number in range(mirrors):
        rng = np.random.default_rng(number)
        model = changed(rng.uniform(0.7, 1.3), rng.uniform(0.5, 1.6), rng.uniform(0.75, 1.35))
        lags = int(rng.integers(0, 4))
        creep = Creep(tuple(rng.uniform(0.0, 0.02, lags) * GAIN), tuple(10.0 ** rng.uniform(-1.5, 1.0, lags)))
        loop = loop_of(model, creep, jitter=rng.uniform(0.7, 1.4), body=rng.uniform(0.5, 1.2))
        loop = replace(loop, gauge=StrainGauge(0.1e-6 * rng.uniform(0.7, 1.4), 0.027e-6))
        rms = {}
        for name, each in made.items():
            residual, _, counts = advance(loop, each, number, np.zeros((4 * RATE_HZ + 1, 1, 1)))
            rms[name] = np.sqrt(np.mean(residual.reshape(4, RATE_HZ, kernels.LANES) ** 2, axis=1))
        ratios.append(rms["adaptive"] / rms["frozen"])
        fallbacks += float(counts[kernels.COUNT_FALLBACK].sum())
    found = np.array(ratios)
    print(
        f"{mirrors * kernels.LANES} runs of 4 s: worst second {np.max(found):.4f} of the frozen one's rms, "
        f"{np.mean(found > 1.05):.2%} of them above 1.05; best {np.min(found):.3f}, mean {np.mean(found):.4f}; "
        f"{fallbacks:.0f} fallbacks"
    )


DRIVER = """
#include "code.h"
void begin(code_state *s) { code_init(s); }
unsigned long size(void) { return sizeof(code_state); }
void run(code_state *s, unsigned long n, const double *m) {
    double v[CODE_ACTUATORS];
    for (unsigned long k = 0; k < n; k++, m += CODE_READINGS) code_step(s, ARGUMENTS, v);
}
"""


def step_cost() -> None:
    """Bar 3: nanoseconds of a step of the exported code, on a mirror that has changed."""
    loop, samples, timed = loop_of(PLAYS, axes=2), 4 * RATE_HZ, {}
    softer = replace(loop, mirror=loop_of(changed(0.8, 1.3), CREEP, axes=2).mirror)
    with tempfile.TemporaryDirectory() as folder:
        for name, made in both(loop, tuned_axis()).items():
            timed[name] = compiled(Path(folder, name), loop, made, replay(softer, made, samples, 1).inputs)
        least = dict.fromkeys(timed, np.inf)
        for _ in range(60):
            for name, run in timed.items():
                begin = time.perf_counter()
                run()
                least[name] = min(least[name], (time.perf_counter() - begin) / samples)
    shown = ", ".join(f"{name} {1e9 * t:.0f} ns" for name, t in least.items())
    print(f"a step of exported C, two axes: {shown}; ratio {least['adaptive'] / least['frozen']:.2f}")


def compiled(folder: Path, loop: fine.PointingLoop, made: fine.LoopController, inputs: np.ndarray):  # type: ignore[no-untyped-def]
    """A run of the exported code over these inputs."""
    period, axes = loop.timing.period_s, loop.axes
    names = (records.OPTICAL_ERROR, records.GAUGE, records.REFERENCE)
    signals = tuple(records.Signal(name, axes, "rad", name, 0.1) for name in names)
    of = choice.trimmed(
        records.FlightController(
            made.name, records.Origin("benchmark", "0" * 64, "plays"), period, signals, axes, made.system,
            made.anti_windup, choice.inverse_law(made.inverse, period, False), loop.drive.minimum_v,
            loop.drive.maximum_v, loop.drive.drive_resolution_v, 6.0, (),
            adaptation=choice.adaptive_law(made.adaptation, period),
        )
    )  # fmt: skip
    looked = np.any(made.system.B, axis=0) | np.any(made.system.D, axis=0)
    m = np.ascontiguousarray(inputs[:, looked])
    folder.mkdir()
    for file, text in flight_code(of, sections(of), "code", "double").items():
        (folder / file).write_text(text)
    places = ", ".join(f"m + {2 * i}" for i in range(len(of.inputs)))
    (folder / "driver.c").write_text(DRIVER.replace("ARGUMENTS", places))
    command = ["cc", "-std=c99", "-O2", "-shared", "-fPIC", "-o", "code.so", "code.c", "driver.c", "-lm"]
    subprocess.run(command, cwd=folder, check=True)
    library = ctypes.CDLL(str(folder / "code.so"))
    library.size.restype = ctypes.c_ulong
    state = (ctypes.c_char * library.size())()

    def run() -> None:
        library.begin(state)
        library.run(state, ctypes.c_ulong(len(m)), m.ctypes.data_as(ctypes.c_void_p))

    return run


if __name__ == "__main__":
    straightening()
    scenarios(int(sys.argv[1]) if len(sys.argv) > 1 else 160)
    step_cost()
