"""Time per plant step of many runs side by side, against the scalar C twin of the loop, and memory; in one run.

    python benchmarks/ensemble.py            # ratio to the twin, 1000 runs of 10 s at 50 kHz on two threads, memory
    python benchmarks/ensemble.py --quick    # the ratio alone

One axis of the paper's mirror (Eq. 2 and 3) at 50 kHz, PI at 5 kHz with one sample of delay, a 1 kHz amplifier, the
paper's 15 Hz sine of 300 µrad. The twin (loop_twin.c, -O3 -march=native) does the same arithmetic a run at a time, with
the C library's exponential; both run on one core, in turn, and must agree. What random numbers cost is printed apart.
"""

import ctypes
import resource
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from loop import INTEGER, Counters, best, compiled_twin, twin_parameters
from microrad import mirror
from microrad.core import kernels, lti
from microrad.loop import control, disturbance
from microrad.loop import sine_run as simulate
from microrad.loop.pointing_loop import ensemble, kernel_arrays, traces
from microrad.loop.pointing_loop import loop as fine
from microrad.loop.sensor import OpticalSensor
from microrad.mission import file as missionfile
from recorded import record

HERE = Path(__file__).resolve().parent
PERIOD_S, STEPS = 200e-6, 10
INTEGRAL_HZ = 60.0
PROPORTIONAL_SHARE = 0.2
PIECE, ROUNDS = 150, 20  # control samples in a timed piece, and how often fifteen of each are timed


def scene() -> tuple[fine.PointingLoop, fine.LoopController, simulate.Setup]:
    """The loop without noise, its controller, and the same for the scalar kernel that the twin is made from."""
    mission = missionfile.load_mission(HERE.parent / "missions" / "leo-geo.toml").mission
    m = mirror.of(mission).line_of_sight[mirror.Variant.GIVEN].plant
    drive = control.Drive(-6.0, 6.0, 1e3, 1e6 / 15.0, 0.305e-3, 0.0)
    timing = control.Timing(PERIOD_S, STEPS, STEPS)
    gain = m.bouc_wen[0].d1_rad_v
    pid = control.pid(control.Gains(PROPORTIONAL_SHARE / gain, 2 * np.pi * INTEGRAL_HZ / gain, 1e-9, 1e-4), PERIOD_S)
    setup = simulate.Setup(drive, timing, pid)
    reference = disturbance.Reference(0.0, 0.0, 1.0, 300e-6, 15.0)
    sensor = OpticalSensor(0.0, 1.0, drive.sensor_resolution_rad, 1, 0)
    p = fine.PointingLoop(m, np.eye(1), drive, timing, ((),), sensor, None, (reference,))
    both = lti.StateSpace(pid.A, np.hstack([pid.B, 0 * pid.B]), pid.C, np.hstack([pid.D, 0 * pid.D]))
    axis = control.AxisController("PI", both, control.anti_windup(pid))
    return p, fine.assemble("PI", p, axis), setup


def ratio() -> None:
    """Time a step of the ensemble kernel and of the C twin, with and without random numbers; the two must agree.

    Taken in pieces of about a millisecond, the shortest of many: longer ones would be cut by whatever else runs.
    """
    p, c, setup = scene()
    noisy = replace(p, disturbances=((disturbance.olympus(),),), optical=replace(p.optical, noise_rad=1e-6))
    nothing, runs = np.empty((0, 0, 0)), kernels.LANES

    def reference_of(samples: int) -> np.ndarray:
        return np.ascontiguousarray(p.references[0].at(np.arange(samples + 1) * PERIOD_S)[:, None])

    def side_by_side(loop: fine.PointingLoop) -> Callable[[], None]:
        arrays = kernel_arrays.arrays(loop, c, 1)
        state, reference = kernel_arrays.start(loop, arrays, 0), reference_of(PIECE)
        state.place[kernels.COUNTING] = 1
        return lambda: kernels.ensemble_loop(arrays, state, reference[:, :, None], nothing, nothing, kernels.UNSHIFTED)

    def c_twin(samples: int) -> tuple[Callable[[], None], np.ndarray]:
        plant = mirror.discretise(p.mirror, setup.timing.step_s)
        scalar = simulate.assemble(p.mirror, setup, control.no_feedforward(p.mirror))
        parameters, filled = twin_parameters(plant, scalar), [np.empty((samples, 1)) for _ in range(3)]
        reference, pending, counters = reference_of(samples), np.zeros(scalar.delay_steps + 1), Counters()
        pointers = [a.ctypes.data_as(ctypes.c_void_p) for a in (reference, pending, *filled)]
        return lambda: twin.closed_loop(
            ctypes.byref(parameters), INTEGER(samples), *pointers, ctypes.byref(counters)
        ), filled[0]

    with tempfile.TemporaryDirectory() as folder:
        twin = compiled_twin(folder)
        pieces = {"kernel": side_by_side(p), "noisy": side_by_side(noisy), "twin": c_twin(PIECE * runs)[0]}
        pieces["kernel"]()  # compiled, or loaded from the cache, before it is timed
        rounds = [best(pieces) for _ in range(ROUNDS)]
        times = {name: min(each[name] for each in rounds) for name in pieces}
        run_twin, theirs = c_twin(10_000)
        run_twin()
    traced = traces.trace(p, c, ensemble.Span(10_000 * PERIOD_S, 0.0, 1))
    np.testing.assert_allclose(traced.mirror_rad[:, 0], theirs[:, 0], rtol=0.0, atol=1e-9 * np.abs(theirs).max())
    steps = PIECE * STEPS * runs
    kernel, noise, c_step = (times[name] / steps * 1e9 for name in ("kernel", "noisy", "twin"))
    print(f"one axis with hysteresis, {runs} runs side by side, ns a plant step and run on one core")
    print(f"  kernel {kernel:6.2f}, C twin {c_step:6.2f}: ratio {kernel / c_step:.3f}")
    record(f"{runs} runs side by side: kernel over scalar C twin, a plant step", kernel / c_step)
    print(f"  with disturbance and sensor noise {noise:6.2f}, so random numbers cost {noise - kernel:.2f}")


def many_runs(runs: int = 1000, seconds: float = 10.0) -> None:
    """The ensemble that the issue names: time on two threads, memory above import, the same results on one."""
    p, c, _ = scene()
    p = replace(p, disturbances=((disturbance.olympus(),),), optical=replace(p.optical, noise_rad=1e-6))
    span = ensemble.Span(seconds, 1.0, 1)
    ensemble.simulate(p, c, replace(span, duration_s=1.1), 1)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    began = time.perf_counter()
    two = ensemble.simulate(p, c, span, runs, threads=2)
    took = time.perf_counter() - began
    grown = (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) / 1024
    print(f"\n{runs} runs of {seconds:g} s at 50 kHz with disturbance and noise: {took:.1f} s on two threads")
    print(f"  {runs * seconds / took:.0f} times real time; memory grew by {grown:.0f} MB above one run")
    print(f"  rms {two.axis_rms_rad[0] * 1e6:.3f} µrad, 99.7 % {two.quantile_rad(0.997) * 1e6:.3f} µrad")
    one = ensemble.simulate(p, c, span, 128, threads=1)
    same = np.array_equal(one.rms_rad, two.rms_rad[:128]) and np.array_equal(one.histogram, two.histogram[:128])
    print(f"  the first 128 runs on one thread: {'identical' if same else 'DIFFERENT'}")


if __name__ == "__main__":
    ratio()
    sys.exit(None if "--quick" in sys.argv else many_runs())
