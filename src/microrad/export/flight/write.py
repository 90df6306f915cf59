"""Flight code into a folder: sources, recorded vectors, a report and a manifest; compiled and run where possible."""

import hashlib
import json
import platform
from dataclasses import asdict, dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any, Literal

from microrad.core.folder import MANIFEST, check_folder, whole_folder
from microrad.core.progress import Progress
from microrad.core.units import format_quantity
from microrad.export.choice import Choice, Source, flight_controller, promised, rms_text, vectors
from microrad.export.flight.build import BenchResult, compile_and_run, compiler
from microrad.export.flight.c_code import flight_code, vectors_text, within_limits
from microrad.export.flight.fixed import fixed_code, quantisation_text, quantised
from microrad.export.flight.fixed_form import FixedForm
from microrad.export.flight.operations import FixedOperations, Operations, fixed_operations, operations
from microrad.export.flight.rounding import RoundingBound, rounding_bound
from microrad.export.flight.stack import StackUse, stack_use
from microrad.export.identifiers import identifier, suggested
from microrad.export.linear_part.sections import Sections, sections
from microrad.export.records import FlightController, Vectors
from microrad.loop.controller_study import Outlook

Precision = Literal["double", "single", "fixed"]
PRECISIONS: dict[Precision, str] = {"double": "double precision", "single": "single precision", "fixed": "fixed point"}

KIND, WHAT = "export", "exported code"
"""Key of the manifest, and what the folder holds, in words."""


@dataclass(frozen=True, slots=True)
class FlightExport:
    """What was written: the controller in its form, what a step costs, how exact it is, and what the bench found.

    ``bench`` is None where there is no compiler, ``stack`` where that does not tell. ``bound`` belongs to single
    precision, ``fixed`` to fixed point, ``left`` to the fine-pointing loop.
    """

    folder: Path
    name: str
    precision: Precision
    controller: FlightController
    left: Outlook | None
    form: Sections
    cost: Operations | FixedOperations
    bound: RoundingBound | None
    fixed: FixedForm | None
    samples: int
    bench: BenchResult | None
    stack: StackUse | None


def check_output(folder: Path, overwrite: bool) -> None:
    """Refuse a folder that holds something which an export must not replace.

    Args:
        folder: Where an export is to be written.
        overwrite: Whether an earlier export there may be replaced.

    Raises:
        FolderError: Where the folder must not be replaced.
    """
    check_folder(folder, overwrite, KIND, WHAT)


def export_flight(
    choice: Choice,
    folder: Path,
    *,
    name: str | None = None,
    precision: Precision = "double",
    samples: int = 5000,
    overwrite: bool = False,
    accept: bool = False,
    on_progress: Progress = lambda done, total, what: None,
) -> FlightExport:
    """Write a controller as C99 with its test bench, a recorded run, a report and a manifest.

    Where there is a C compiler, the code is compiled and its bench run over the recorded run before the folder appears.

    Args:
        choice: The controller, see `choice.choose`.
        folder: Where to write; it appears whole or not at all.
        name: What the code is called, an identifier of C; None makes one of the controller's name.
        precision: Precision of the code: "double", "single" or "fixed" point.
        samples: Length of the recorded run, in control periods.
        overwrite: Replace an earlier export in the folder.
        accept: Write also what `choice.promised` refuses.
        on_progress: Is told what is being done.

    Raises:
        ExportError: The controller cannot be exported, its code strays from the kernel, or it leaves too much.
        FolderError: The folder must not be replaced.
    """
    check_output(folder, overwrite)
    left = promised(choice, accept)
    controller = flight_controller(choice)
    name = identifier(name if name is not None else suggested(controller.name))
    form = sections(controller)
    on_progress(0, 3, f"recording {samples} samples of the loop")
    run = within_limits(controller, vectors(choice, samples))
    files, cost, bound, fixed = _code(controller, form, run, name, precision)
    with whole_folder(folder, overwrite, KIND, WHAT) as draft:
        for file, text in {**files, "vectors.csv": vectors_text(controller, run)}.items():
            (draft / file).write_text(text, encoding="utf-8", newline="\n")
        on_progress(1, 3, "compiling and running the bench")
        code, bench, stack = name if fixed is None else f"{name}_fixed", None, None
        if compiler() is not None:
            bench = compile_and_run(draft, code)
            sources = [file for file in files if file.endswith(".c") and not file.endswith("_bench.c")]
            stack = stack_use(draft, sources, f"{code}_step")
        for path in draft.iterdir():  # what the compiler left: the folder holds text, for any machine
            if path.name not in files and path.name != "vectors.csv":
                path.unlink()
        found = FlightExport(folder, name, precision, controller, left, form, cost, bound, fixed, samples, bench, stack)
        on_progress(2, 3, "writing")
        (draft / "report.txt").write_text(report_text(found) + "\n", encoding="utf-8", newline="\n")
        text = json.dumps(_manifest(found, choice.source, draft), indent=2, ensure_ascii=False)
        (draft / MANIFEST).write_text(text + "\n", encoding="utf-8")
    return found


def _code(
    of: FlightController, form: Sections, run: Vectors, name: str, precision: Precision
) -> tuple[dict[str, str], Operations | FixedOperations, RoundingBound | None, FixedForm | None]:
    """Files of one precision, what a step costs, and what the precision costs."""
    if precision == "fixed":
        fixed = quantised(of, form, run)
        return fixed_code(of, form, fixed, name), fixed_operations(of, fixed), None, fixed
    bound = rounding_bound(of, form, run) if precision == "single" else None
    return flight_code(of, form, name, precision, bound), operations(of, form, precision), bound, None


def _manifest(of: FlightExport, source: Source, folder: Path) -> dict[str, Any]:
    files = sorted(path for path in folder.iterdir() if path.is_file())
    libraries = ("microrad", "numpy", "scipy", "numba", "jinja2")
    return {
        KIND: {"kind": "flight code", "name": of.name, "controller": of.controller.name, "precision": of.precision},
        "mission": {"file": source.path.name, "sha256": source.origin.mission_sha256, "name": source.origin.mission},
        "samples": of.samples,
        "versions": {"python": platform.python_version(), **{each: version(each) for each in libraries}},
        "files_sha256": {path.name: hashlib.sha256(path.read_bytes()).hexdigest() for path in files},
    }


# ----------------------------------------------------------------------------------------------------------- in words
def report_text(of: FlightExport) -> str:
    """What was exported, what a step costs and how exact it is, in lines."""
    c, rate = of.controller, format_quantity(1.0 / of.controller.period_s, "Hz")
    low, high, bias = (format_quantity(v, "V", 6) for v in (c.minimum_v, c.maximum_v, c.bias_v))
    counts = f", in counts of {format_quantity(c.resolution_v, 'V')}" if c.resolution_v else ""
    margins = [
        f"{name} {format_quantity(value, unit, 3) if unit in ('s', 'Hz') else f'{value:.3g} {unit}'.strip()}"
        for name, value, unit in c.margins
    ]
    inputs, left = ", ".join(f"{each.name}[{each.size}]" for each in c.inputs), of.left
    lines = [
        ("from", f"{c.origin.mission}, sha256 {c.origin.mission_sha256[:16]}"),
        ("mirror", c.origin.mirror),
        ("controller", f"{c.name}, {rate}, {of.form.order} states in {of.form.form} form"),
        ("reads", inputs),
        ("commands", f"{c.actuators} x {low} to {high} from the bias of {bias}{counts}"),
        ("margins", ", ".join(margins)),
        ("leaves", left and f"{rms_text(left.linear_rad)} in linear theory, {rms_text(left.simulated_rad)} simulated"),
        ("a step costs", of.cost.words),
        ("stack", of.stack and of.stack.words),
        ("single", of.bound and of.bound.words),
        *_measured(of.bench),
    ]
    text = "\n".join(f"  {name:13} {words}" for name, words in lines if words)
    quantisation = "" if of.fixed is None else f"\n\n{quantisation_text(of.fixed)}"
    return f"{of.name}: {c.name} in {PRECISIONS[of.precision]}\n{text}{quantisation}"


def _measured(b: BenchResult | None) -> list[tuple[str, str]]:
    if b is None:
        return [("not compiled", "there is no C compiler here (cc, gcc, clang); make in the folder builds the bench")]
    counted = {"saturated": b.saturated, "rate-clamped": b.rate_clamped, "rejected": b.rejected, "faults": b.faults}
    counts = ", ".join(f"{count} {name}" for name, count in counted.items())
    difference, allowed = (format_quantity(v, "V", 3) for v in (b.largest_difference_v, b.bound_v))
    return [
        ("compiled, run", f"{b.samples} samples of the loop: at most {difference} off the kernel (allowed: {allowed})"),
        ("counters", counts),
        ("time a step", f"{b.worst_step_ns:.0f} ns at worst, {b.median_step_ns:.0f} ns in the median, on this machine"),
        ("cycles", _cycles(b)),
    ]


def _cycles(b: BenchResult) -> str:
    """The times in cycles of the processor's counter; nothing where it has none."""
    if not b.cycles_per_ns:
        return ""
    worst, median = (b.cycles_per_ns * each for each in (b.worst_step_ns, b.median_step_ns))
    rate = format_quantity(1e9 * b.cycles_per_ns, "Hz", 3)
    return f"{worst:.0f} at worst, {median:.0f} in the median, of this machine's counter at {rate}"


def export_data(of: FlightExport) -> dict[str, Any]:
    """The numbers of the report, for JSON."""
    c = of.controller
    return {
        "name": of.name,
        "controller": c.name,
        "precision": of.precision,
        "mission_sha256": c.origin.mission_sha256,
        "period_s": c.period_s,
        "states": of.form.order,
        "form": of.form.form,
        "inputs": [{"name": s.name, "size": s.size, "unit": s.unit, "limit": s.limit} for s in c.inputs],
        "limits_v": [c.minimum_v, c.maximum_v],
        "bias_v": c.bias_v,
        "margins": {name: {"value": value, "unit": unit} for name, value, unit in c.margins},
        "residual": None
        if of.left is None
        else {
            "linear_rms_rad_per_axis": of.left.linear_rad,
            "simulated_rms_rad_per_axis": of.left.simulated_rad,
        },
        "operations": asdict(of.cost),
        "stack": None if of.stack is None else asdict(of.stack),
        "bound": None if of.bound is None else asdict(of.bound),
        "bench": None if of.bench is None else asdict(of.bench),
    }
