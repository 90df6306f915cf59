"""Time per step of the sampled closed loop, against a C twin, SciPy, python-control and real time, in one run.

    python benchmarks/loop.py

The trajectory is the paper's 15 Hz sine of 300 µrad on its mirror (Eq. 2 and 3) at 50 kHz, under PID and PID +
inverse, with the shipped mission's amplifier, converters and delay. The twin does the same arithmetic, with the C
library's exponential. The peers integrate the mirror alone under the drive that the loop produced, linear between
samples, which spares them the controller; errors are against SciPy at 1e-12.
"""

import ctypes
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import control as python_control
import numpy as np
from scipy.integrate import solve_ivp

from microrad import mirror
from microrad.core import kernels
from microrad.loop import control as microrad_control
from microrad.loop import paper_cases
from microrad.loop import sine_run as simulate
from microrad.mirror import hysteresis
from microrad.mission import file as missionfile
from recorded import record

HERE = Path(__file__).resolve().parent
REPEATS = 15
DERIVATIVE_V_S_RAD = 0.01  # small, but there, so that both carry all states of a PID
DOUBLE, INTEGER = ctypes.c_double, ctypes.c_int64


class Parameters(ctypes.Structure):
    """The C twin's parameters, in its order."""

    _fields_ = (
        [
            (n, DOUBLE)
            for n in (
                "step_s",
                "d1",
                "d2",
                "epsilon",
                "delta",
                "alpha",
                "beta",
                "rate_limit",
                "bias",
                "gamma",
                "eta",
            )
        ]
        + [(n, DOUBLE * 5) for n in ["diagonal", "coupling", "held", "end", "output"]]
        + [
            (n, DOUBLE)
            for n in (
                "proportional_step",
                "integral_step",
                "derivative_gain",
                "filter_keep",
                "windup_integral",
                "windup_filter",
                "command_min",
                "command_max",
                "drive_resolution",
                "sensor_resolution",
                "amplifier_factor",
                "slew_step",
            )
        ]
        + [(n, INTEGER) for n in ["steps_per_sample", "delay_steps", "feedforward"]]
    )


class Counters(ctypes.Structure):
    """The C twin's counters."""

    _fields_ = [(n, INTEGER) for n in ["clamped", "saturated", "slew_limited", "inverse_clamped"]]


def compiled_twin(folder: str) -> ctypes.CDLL:
    """The twin, compiled for this machine."""
    library = Path(folder) / "loop_twin.so"
    flags = ["-O3", "-march=native", "-shared", "-fPIC"]
    subprocess.run(["gcc", *flags, "-o", str(library), str(HERE / "loop_twin.c"), "-lm"], check=True)
    return ctypes.CDLL(str(library))


def twin_parameters(plant: kernels.Plant, loop: kernels.Loop) -> Parameters:
    """The kernel's own arrays, picked apart for the twin: modes 0 and 1 are the complex pair."""
    five = DOUBLE * 5
    return Parameters(
        plant.step_s,
        *plant.bouc_wen[0, : kernels.POWER],
        five(*plant.diagonal[:5]),
        five(*plant.coupling[:2], 0.0, 0.0, 0.0),
        five(*plant.E_held[:5, 0]),
        five(*plant.E1[:5, 0]),
        five(*plant.C[0, :5]),
        loop.Dc[0, 0],
        loop.Bc[0, 0],
        -loop.Cc[0, 1],
        loop.Ac[1, 1],
        *loop.L[:, 0],
        *loop.actuator[0, :3],
        loop.sensor_resolution[0],
        *loop.actuator[0, 3:],
        loop.steps_per_sample,
        loop.delay_steps,
        int(loop.inverse_bouc_wen.shape[0] > 0),
    )


def best(functions: dict[str, Callable[[], None]]) -> dict[str, float]:
    """Shortest time of each in seconds, taken in turn so that a noisy moment hits all alike."""
    times = dict.fromkeys(functions, np.inf)
    for _ in range(REPEATS):
        for name, function in functions.items():
            start = time.perf_counter()
            function()
            times[name] = min(times[name], time.perf_counter() - start)
    return times


def loop_against_twin(
    twin: ctypes.CDLL, m: mirror.Mirror, setup: simulate.Setup, inverse: microrad_control.Inverse, reference: np.ndarray
) -> tuple[dict[str, float], np.ndarray, np.ndarray]:
    """Time per plant step of kernel and twin, and the kernel's output and drive; the two must agree."""
    plant, loop = mirror.discretise(m, setup.timing.step_s), simulate.assemble(m, setup, inverse)
    parameters = twin_parameters(plant, loop)
    ours, theirs = ([np.empty_like(reference) for _ in range(3)] for _ in range(2))

    def kernel() -> None:
        kernels.closed_loop(plant, mirror.at_rest(plant), loop, simulate.at_rest(loop), reference, *ours)

    def c_twin() -> None:
        pending = np.zeros(loop.delay_steps + 1)
        arrays = [a.ctypes.data_as(ctypes.c_void_p) for a in (reference, pending, *theirs)]
        counters = Counters()
        twin.closed_loop(ctypes.byref(parameters), INTEGER(reference.size), *arrays, ctypes.byref(counters))

    kernel()  # compiled, or loaded from the cache, before it is timed
    times = best({"kernel": kernel, "C twin": c_twin})
    np.testing.assert_allclose(ours[0], theirs[0], rtol=0.0, atol=1e-9 * np.abs(ours[0]).max())
    steps = reference.size * setup.timing.steps_per_sample
    return {name: t / steps for name, t in times.items()}, ours[0][:, 0], ours[2][:, 0]


def mirror_equations(m: mirror.Mirror, time_s: np.ndarray, drive: np.ndarray) -> Callable[..., np.ndarray]:
    """Right-hand side of the cascade under a drive linear between samples; states: linear part, then h."""
    b, rates, step = m.bouc_wen[0], np.diff(drive), time_s[1] - time_s[0]

    def equations(t: float, state: np.ndarray) -> np.ndarray:
        k = min(int(t / step), rates.size - 1)
        rate = rates[k] / step
        u, h = drive[k] + rate * (t - k * step), state[-1]
        growth = b.epsilon_rad_v * np.exp(b.delta_s_v * abs(rate))
        z = b.d1_rad_v * (np.exp(-b.d2_s_v * rate) * (u + b.bias_v) - b.bias_v) + h
        slope = growth * rate - b.beta_1_v * rate * abs(h) - b.alpha_1_v * abs(rate) * h
        return np.append(m.A @ state[:-1] + m.E[:, 0] * z, slope)

    return equations


def peers(m: mirror.Mirror, time_s: np.ndarray, drive: np.ndarray) -> dict[str, tuple[float, np.ndarray]]:
    """Seconds and output of each peer over the same drive."""
    equations, start = mirror_equations(m, time_s, drive), np.zeros(m.A.shape[0] + 1)
    span, step = (time_s[0], time_s[-1]), time_s[1] - time_s[0]
    found = {}

    def scipy(method: str, rtol: float) -> np.ndarray:
        options = {"t_eval": time_s, "rtol": rtol, "atol": rtol * 1e-6, "max_step": step}
        return m.C[0] @ solve_ivp(equations, span, start, method=method, **options).y[:-1]

    def with_python_control() -> np.ndarray:
        system = python_control.NonlinearIOSystem(
            lambda t, x, u, p: equations(t, x),
            lambda t, x, u, p: m.C[0] @ x[:-1],
            inputs=1,
            outputs=1,
            states=start.size,
        )
        options = {"solve_ivp_kwargs": {"rtol": 1e-6, "atol": 1e-12, "max_step": step}, "solve_ivp_method": "LSODA"}
        return python_control.input_output_response(system, time_s, drive, start, **options).outputs

    runs: dict[str, Callable[[], np.ndarray]] = {
        "reference, LSODA at 1e-12": lambda: scipy("LSODA", 1e-12),
        "solve_ivp, LSODA at 1e-3": lambda: scipy("LSODA", 1e-3),
        "solve_ivp, LSODA at 1e-6": lambda: scipy("LSODA", 1e-6),
        "solve_ivp, RK45 at 1e-6": lambda: scipy("RK45", 1e-6),
        "solve_ivp, Radau at 1e-6": lambda: scipy("Radau", 1e-6),
        "python-control, LSODA at 1e-6": with_python_control,
    }
    for name, run in runs.items():
        began = time.perf_counter()
        output = run()
        found[name] = (time.perf_counter() - began, output)
    return found


def main() -> None:
    mission = missionfile.load_mission(HERE.parent / "missions" / "leo-geo.toml").mission
    cases = paper_cases.of(mission, mirror.of(mission))
    given, setup = cases.mirrors.line_of_sight[mirror.Variant.GIVEN], cases.setup
    m = given.plant
    period = setup.timing.period_s
    gains = microrad_control.gains_from_mission(mission.control, hysteresis.slow_gain(given.model))
    controller = microrad_control.pid(replace(gains, derivative=DERIVATIVE_V_S_RAD), period)
    setup = replace(setup, timing=microrad_control.Timing(period, 1, 1), controller=controller)
    reference, _ = simulate.sine(mission.scenario.amplitude_rad, 15.0, period, settle_s=2.0)

    print(
        f"one axis, one plant step a control sample of {period * 1e6:g} µs, {reference.size} steps, best of {REPEATS}"
    )
    with tempfile.TemporaryDirectory() as folder:
        twin = compiled_twin(folder)
        for name, inverse in (
            ("PID + inverse", microrad_control.inverse(m)),
            ("PID", microrad_control.no_feedforward(m)),
        ):
            times, output, drive = loop_against_twin(twin, m, setup, inverse, reference)
            ratio = times["kernel"] / times["C twin"]
            print(f"\n{name}")
            kernel_ns, twin_ns = (times[name] * 1e9 for name in ("kernel", "C twin"))
            print(f"  kernel {kernel_ns:6.1f} ns a step, C twin {twin_ns:6.1f} ns: ratio {ratio:.2f}")
            record(f"{name}: kernel over C twin, a plant step", ratio)
            print(f"  {period / times['kernel']:.0f} times real time at {1 / period / 1e3:g} kHz on one core")

    short = slice(0, round(0.2 / period))
    time_s = np.arange(reference.shape[0])[short] * period
    found = peers(m, time_s, drive[short])
    exact = found.pop("reference, LSODA at 1e-12")[1]
    ours = np.abs(output[short] - exact).max()
    print(
        "\nthe same trajectory, 0.2 s: time a step, error against the reference, and how many times the kernel's time"
    )
    print(f"  {'kernel, with controller':32s} {times['kernel'] * 1e6:9.3f} µs  {ours * 1e9:10.4f} nrad")
    for name, (seconds, result) in found.items():
        per_step = seconds / time_s.size
        error = np.abs(result - exact).max()
        print(f"  {name:32s} {per_step * 1e6:9.3f} µs  {error * 1e9:10.4f} nrad  {per_step / times['kernel']:8.0f} x")


if __name__ == "__main__":
    sys.exit(main())
