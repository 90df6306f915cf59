"""Time per plant step of a mirror of several axes against a C twin of the same mirror, in one run.

    python benchmarks/coupled_step.py

Made-up mirrors on three actuators with springs of five plays: 6 states and 3 springs, and 36 states and 12 springs, as
many as the CubeSpec mirror has. The twin (coupled_twin.c, -O3 -march=native, its sizes known to the compiler) runs the
mirror alone. "One run" is the kernel that identification and responses use. "64 side by side" is the pointing loop with
controller, amplifier, delay and sensor around the mirror, which the twin does without. All must agree.
"""

import ctypes
import subprocess
import tempfile
from pathlib import Path

import numpy as np

from loop import best
from microrad.core import kernels, lti
from microrad.core.arrays import Floats
from microrad.loop import control, disturbance
from microrad.loop.pointing_loop import kernel_arrays
from microrad.loop.pointing_loop.loop import LoopController, PointingLoop
from microrad.loop.sensor import OpticalSensor
from microrad.mirror import model
from microrad.mirror.hysteresis import PrandtlIshlinskii
from microrad.mirror.model import Mirror
from recorded import record

HERE = Path(__file__).resolve().parent
STEP_S, STEPS_A_SAMPLE = 20e-6, 10
THRESHOLDS = (0.0, 0.05, 0.15, 0.35, 0.7)
SAMPLES, ROUNDS = 40, 3
"""Control samples in a timed piece, and how often fifteen of each are timed."""


def made_up(modes: int, springs: int) -> Mirror:
    """A mirror of light modes on springs that each mode stretches, with weights that soften it by some per cent."""
    rng = np.random.Generator(np.random.Philox(1))
    w = 2.0 * np.pi * np.geomspace(300.0, 3000.0, modes)
    A, n = lti.modal_matrix([(-0.01 * each, each) for each in w]), 2 * modes
    phi = rng.standard_normal((modes, springs)) / np.sqrt(modes * springs)
    B, C, E, F = np.zeros((n, 3)), np.zeros((3, n)), np.zeros((n, springs)), np.zeros((springs, n))
    B[1::2], C[:, 0::2] = -w[:, None] * rng.standard_normal((modes, 3)), 1e-6 * rng.standard_normal((3, modes))
    E[1::2], F[:, 0::2] = -0.3 * w[:, None] * phi, phi.T
    plays = tuple(
        PrandtlIshlinskii(THRESHOLDS, (0.0, *rng.uniform(0.1, 0.3, len(THRESHOLDS) - 1))) for _ in range(springs)
    )
    G, D, K = np.zeros((springs, 3)), np.zeros((3, 3)), 1e-7 * rng.standard_normal((3, springs))
    return Mirror(f"{n} states, {springs} springs", A, B, E, F, G, C, D, K, (), plays, ())


def compiled(m: Mirror, folder: str) -> ctypes.CDLL:
    """The twin for the sizes of a mirror."""
    library = Path(folder) / f"twin_{m.A.shape[0]}.so"
    sizes = {"STATES": m.A.shape[0], "ACTUATORS": m.actuators, "OUTPUTS": m.axes, "SPRINGS": len(m.bank)}
    words = [f"-D{name}={size}" for name, size in (sizes | {"PLAYS": len(THRESHOLDS)}).items()]
    flags = ["-O3", "-march=native", "-shared", "-fPIC"]
    subprocess.run(["gcc", *flags, *words, "-o", str(library), str(HERE / "coupled_twin.c"), "-lm"], check=True)
    return ctypes.CDLL(str(library))


def twin_parameters(m: Mirror, plant: kernels.Plant) -> Floats:
    """The kernel's arrays in the order of the twin's record, each matrix column by column."""
    weights = plant.play_weight.reshape(len(m.bank), len(THRESHOLDS))
    columns = (plant.B0, plant.B1, plant.E_held, plant.E1, plant.F, plant.C, plant.K)
    parts = [plant.diagonal, plant.coupling, *(matrix.T for matrix in columns), np.array(THRESHOLDS), weights]
    return np.concatenate([np.ravel(part) for part in parts])


def side_by_side(m: Mirror) -> tuple[PointingLoop, LoopController]:
    """The mirror in a loop without noise that follows a sine with an integrator on each axis."""
    optics = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    references = tuple(disturbance.Reference(0.0, 0.0, 1.0, 1e-6, freq_hz) for freq_hz in (15.0, 20.0))
    period_s = STEP_S * STEPS_A_SAMPLE
    drive = control.Drive(-10.0, 10.0, 1e3, 1e5, 0.0, 0.0)
    timing = control.Timing(period_s, STEPS_A_SAMPLE, STEPS_A_SAMPLE)
    sensor = OpticalSensor(0.0, 1.0, 0.0, 1, 0)
    loop = PointingLoop(m, optics, drive, timing, ((), ()), sensor, None, references)
    gain = np.linalg.pinv(optics @ -(m.C @ np.linalg.solve(m.A, m.B)))
    inputs = np.hstack([np.eye(2), np.zeros((2, 5))])  # the sensor alone, no gauge and no reference
    system = lti.StateSpace(np.eye(2), inputs, 2.0 * np.pi * 5.0 * period_s * gain, np.zeros((3, 7)))
    return loop, LoopController("integrators", system, np.zeros((2, 3)))


def measured(m: Mirror, folder: str) -> tuple[float, float, float]:
    """Nanoseconds a step (and run) of twin, one run and 64 side by side."""
    twin, plant = compiled(m, folder), model.discretise(m, STEP_S)
    parameters = twin_parameters(m, plant)
    steps = SAMPLES * STEPS_A_SAMPLE * kernels.LANES
    time_s = np.arange(steps)[:, None] * STEP_S
    drive = np.sin(2.0 * np.pi * np.array([15.0, 70.0, 400.0]) * time_s)
    theirs, ours, bank = np.empty((steps, m.axes)), np.empty((steps, m.axes)), np.empty((steps, 0))
    memory, state = np.zeros(m.A.shape[0] + m.actuators + len(m.bank) * (1 + len(THRESHOLDS))), model.at_rest(plant)
    pointers = [a.ctypes.data_as(ctypes.c_void_p) for a in (parameters, memory)]
    ends = [a.ctypes.data_as(ctypes.c_void_p) for a in (drive, theirs)]

    def c_twin() -> None:
        twin.run(*pointers, ctypes.c_int64(steps), *ends)

    def one_run() -> None:
        model.respond(plant, state, drive, ours, bank)

    c_twin()
    one_run()
    np.testing.assert_allclose(ours, theirs, rtol=0.0, atol=1e-9 * np.abs(theirs).max())
    loop, controller = side_by_side(m)
    arrays, nothing = kernel_arrays.arrays(loop, controller, 1), np.empty((0, 0, 0))
    several, wanted = kernel_arrays.start(loop, arrays, 0), kernel_arrays.reference(loop, 0, SAMPLES)
    several.place[kernels.COUNTING] = 1

    def ensemble() -> None:
        kernels.ensemble_loop(arrays, several, wanted, nothing, nothing, kernels.UNSHIFTED)

    ensemble()
    pieces = {"twin": c_twin, "one run": one_run, "side by side": ensemble}
    rounds = [best(pieces) for _ in range(ROUNDS)]
    return tuple(min(each[name] for each in rounds) / steps * 1e9 for name in pieces)


def main() -> None:
    """Print a line for each mirror."""
    print("ns a plant step on one core          C twin   one run  ratio   64 side by side  ratio")
    with tempfile.TemporaryDirectory() as folder:
        for modes, springs in ((3, 3), (18, 12)):
            m = made_up(modes, springs)
            twin, one, many = measured(m, folder)
            record(f"{m.name}: one run over C twin, a plant step", one / twin)
            record(f"{m.name}: 64 side by side over C twin, a plant step", many / twin)
            print(f"{m.name:36} {twin:6.1f}   {one:7.1f}  {one / twin:5.2f}   {many:15.1f}  {many / twin:5.2f}")


if __name__ == "__main__":
    main()
