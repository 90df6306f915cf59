"""Time of a step of exported flight code on this machine, beside the same controller as dense C and in python-control.

    python benchmarks/flight_step.py [samples]

Controllers of the shipped mission's fine-pointing loop, over a recorded run of it. Worst: the slowest sample, each at
its least time over 20 passes, without the clock's own time; a whole step, with its checks of readings and commands. The
dense twin keeps every number of the matrices, as the kernel does, and checks nothing; it shares the hysteresis header,
and its commands have to agree too. python-control steps the linear part alone. Operations: the most that a step takes.
"""

import re
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import control as python_control
import numpy as np

from microrad.core import lti
from microrad.export import choice, records
from microrad.export.flight import build, c_code, fixed, operations, rounding
from microrad.export.linear_part import sections
from microrad.export.templating import table
from microrad.mission.file import load_mission
from recorded import record

MISSION = Path(__file__).resolve().parent.parent / "missions" / "leo-geo.toml"
CONTROLLERS = ("PI + inverse", "PI + inverse in series", "LQG")
PASSES, REPEATS = 20, 2000

TWIN = """#include "code.h"
#include <string.h>

enum { N = STATES, M = CODE_READINGS, P = OUTPUTS, V = CODE_ACTUATORS };

static const double A[N][N] = MATRIX_A;
static const double B[N][M] = MATRIX_B;
static const double C[P][N] = MATRIX_C;
static const double D[P][M] = MATRIX_D;
static const double L[N][V] = MATRIX_L;

static double x[N];
INVERSE
void code_init(code_state *state)
{
    memset(state, 0, sizeof *state);
    memset(x, 0, sizeof x);
RESET
}

void code_step(code_state *state, PARAMETERS, double command_v[V])
{
    double m[M], y[P], off[V], next[N];

READ
    for (int i = 0; i < P; i++) {
        y[i] = 0.0;
        for (int j = 0; j < N; j++) y[i] += C[i][j] * x[j];
        for (int j = 0; j < M; j++) y[i] += D[i][j] * m[j];
    }
ADD
    for (int a = 0; a < V; a++) {
        const double above = y[a] < LOW ? LOW : y[a];
        const double clipped = above > HIGH ? HIGH : above;
        off[a] = clipped - y[a];
        command_v[a] = floor(clipped / RESOLUTION + 0.5) * RESOLUTION;
    }
    for (int i = 0; i < N; i++) {
        next[i] = 0.0;
        for (int j = 0; j < N; j++) next[i] += A[i][j] * x[j];
        for (int j = 0; j < M; j++) next[i] += B[i][j] * m[j];
        for (int a = 0; a < V; a++) next[i] += L[i][a] * off[a];
    }
    memcpy(x, next, sizeof x);
    (void)state;
}
"""

INVERSE = """static double target[V], h[V];
static const code_bouc_wen ELEMENT[V] = ROWS;
"""

RESET = """    memset(target, 0, sizeof target);
    memset(h, 0, sizeof h);"""

ADD = """    for (int a = 0; a < V; a++) {
        const code_bouc_wen *e = &ELEMENT[a];
        const double travel = (y[V + a] - target[a]) / e->d1;
        const double rate = code_clamp(y[2 * V + a] / e->d1, -e->rate_limit, e->rate_limit);
        target[a] = y[V + a];
        h[a] = code_bouc_wen_advance(h[a], travel, rate, e, &state->faults);
        y[a] += (target[a] - h[a] + e->d1 * e->bias) / code_bouc_wen_gain(e, rate) - e->bias;
    }
"""


def as_designed(chosen: choice.PointingChoice, of: records.FlightController) -> records.FlightController:
    """The controller with the matrices that the kernel runs: also with modes that nothing drives or no output shows."""
    s, loop, kept = chosen.controller.system, chosen.scene.loop, [each.name for each in of.inputs]
    sizes = {records.OPTICAL_ERROR: loop.axes, records.GAUGE: loop.mirror.axes, records.REFERENCE: loop.axes}
    read = np.repeat([name in kept for name in sizes], list(sizes.values()))
    system = lti.StateSpace(s.A, s.B[:, read], s.C, s.D[:, read])
    return replace(of, system=system, anti_windup=chosen.controller.anti_windup)


def twin(of: records.FlightController) -> str:
    """The controller as it stands in its matrices, in plain C; with a Bouc-Wen element by actuator where it inverts."""
    s, inverse, places = of.system, of.inverse, choice.columns(of.inputs)
    if inverse is not None and (inverse.by_difference or len(inverse.bouc_wen) != of.actuators or any(inverse.direct)):
        raise SystemExit(f"no dense twin is written for the inverse of {of.name!r}")
    read = "    for (int i = 0; i < {}; i++) m[{} + i] = {}[i];"
    values = {
        **{f"MATRIX_{key}": table(getattr(s, key)) for key in "ABCD"},
        "MATRIX_L": table(of.anti_windup),
        "INVERSE": INVERSE.replace("ROWS", table(inverse.bouc_wen)) if inverse is not None else "",
        "RESET": RESET if inverse is not None else "",
        "ADD": ADD if inverse is not None else "",
        "PARAMETERS": ", ".join(f"const double {name}[{at.stop - at.start}]" for name, at in places.items()),
        "READ": "\n".join(read.format(at.stop - at.start, at.start, name) for name, at in places.items()),
        "STATES": str(s.order),
        "OUTPUTS": str(s.C.shape[0]),
        "LOW": f"({of.minimum_v!r})",
        "HIGH": f"({of.maximum_v!r})",
        "RESOLUTION": repr(of.resolution_v),
    }
    return re.sub(rf"\b({'|'.join(values)})\b", lambda found: values[found[0]], TWIN)


def ran(of: records.FlightController, run: records.Vectors, files: dict[str, str], name: str) -> build.BenchResult:
    with tempfile.TemporaryDirectory() as folder:
        for file, text in {**files, "vectors.csv": c_code.vectors_text(of, run)}.items():
            (Path(folder) / file).write_text(text)
        return build.compile_and_run(Path(folder), name, PASSES)


def in_python_control(of: records.FlightController, run: records.Vectors) -> float:
    """Median time in ns of output and next state of the linear part."""
    s, x = of.system, np.zeros(of.system.order)
    system, took = python_control.ss(s.A, s.B, s.C, s.D, of.period_s), []
    for m in run.inputs[:REPEATS]:
        began = time.perf_counter_ns()
        system.output(0.0, x, m)
        x = system.dynamics(0.0, x, m)
        took.append(time.perf_counter_ns() - began)
    return float(np.median(took))


def line(name: str, what: str, found: build.BenchResult, dense: build.BenchResult) -> None:
    worst, median = found.worst_step_ns, found.median_step_ns
    ratios = f"{worst / dense.worst_step_ns:6.2f} {median / dense.median_step_ns:6.2f}"
    strays = f"{found.largest_difference_v:.1e} of {found.bound_v:.1e} V"
    if found is not dense:
        record(f"{name}: {what} over dense C twin, worst step", worst / dense.worst_step_ns)
    print(f"  {what:15} {worst:6.0f} {median:8.0f}   {ratios}       {strays}", flush=True)


def compare(name: str, samples: int) -> None:
    chosen = choice.choose(load_mission(MISSION), name)
    of, run = choice.flight_controller(chosen), choice.vectors(chosen, samples)
    designed, form = as_designed(chosen, of), sections.sections(of)
    whole, bound = fixed.quantised(of, form, run), rounding.rounding_bound(of, form, run)
    double = c_code.flight_code(of, form, "code", "double")
    made = {
        "double": (double, "code"),
        "single": (c_code.flight_code(of, form, "code", "single", bound), "code"),
        "fixed point": (fixed.fixed_code(of, form, whole, "code"), "code_fixed"),
    }
    print(f"\n{name}: {form.order} states, {sum(each.size for each in of.inputs)} readings, {of.actuators} commands")
    print("                   worst   median   times the twin's   difference from the kernel, bound")
    dense = ran(designed, run, {**double, "code.c": twin(designed)}, "code")
    line(name, f"dense, {designed.system.order} states", dense, dense)
    for precision, (files, code) in made.items():
        line(name, precision, ran(of, run, files, code), dense)
    peer = in_python_control(designed, run)
    print(
        f"  python-control         {peer:8.0f}         {peer / dense.median_step_ns:6.0f}       the linear part alone"
    )
    print(f"  double: {operations.operations(of, form, 'double').words}")
    print(f"  single: {operations.operations(of, form, 'single').words}")
    print(f"  fixed point: {operations.fixed_operations(of, whole).words}")


def main() -> None:
    samples = int(sys.argv[1]) if len(sys.argv) > 1 else 5000
    print(f"ns a step over {samples} samples, best of {PASSES} passes, {build.compiler()} {' '.join(build.FLAGS)}")
    for name in CONTROLLERS:
        compare(name, samples)


if __name__ == "__main__":
    main()
