"""Flight code into a folder: sources, recorded vectors, a report and a manifest; compiled and run where possible."""

import hashlib
import json
import platform
from dataclasses import asdict, dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any, Literal

from microrad.core.folder import MANIFEST, check_folder, whole_folder
from microrad.core.units import format_quantity
from microrad.export.build import BenchResult, compile_and_run, compiler
from microrad.export.choice import Choice, flight_controller, promised, rms_text, vectors
from microrad.export.fixed import FixedForm, fixed_code, quantised
from microrad.export.fixed import report_text as quantisation_text
from microrad.export.flight import flight_code, vectors_text, within_limits
from microrad.export.identifiers import identifier, suggested
from microrad.export.operations import FixedOperations, Operations, fixed_operations, operations
from microrad.export.records import FlightController, Progress, Vectors
from microrad.export.rounding import RoundingBound, rounding_bound
from microrad.export.sections import Sections, sections
from microrad.loop.fine_pointing import Outlook

Precision = Literal["double", "single", "fixed"]
PRECISIONS: tuple[Precision, ...] = ("double", "single", "fixed")

KIND, WHAT = "export", "exported code"
"""Key of the manifest, and what the folder holds, in words."""


@dataclass(frozen=True, slots=True)
class FlightExport:
    """What was written: the controller in its form, what a step costs, how exact it is, and what the bench found.

    ``bench`` is None where there is no compiler. ``bound`` belongs to single precision, ``fixed`` to fixed point,
    ``left`` to the fine-pointing loop.
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


def check_output(folder: Path, overwrite: bool) -> None:
    """Raise `FolderError` when ``folder`` holds something that must not be replaced."""
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
    """Write a controller as C99 with its test bench, ``samples`` recorded vectors, a report and a manifest.

    It is compiled and its bench run over the vectors where there is a C compiler, before the folder appears. Raises
    ExportError for what cannot be exported, for code that strays from the kernel and for what `choice.promised`
    refuses; `FolderError` for a folder that must not be replaced.
    """
    check_output(folder, overwrite)
    left = promised(choice, accept)
    controller = flight_controller(choice)
    name = identifier(name if name is not None else suggested(controller.name))
    form = sections(controller)
    on_progress(0, 3, f"recording {samples} samples of the loop")
    run = within_limits(controller, vectors(choice, samples))
    made = _code(controller, form, run, name, precision)
    with whole_folder(folder, overwrite, KIND, WHAT) as draft:
        for file, text in made.files.items():
            (draft / file).write_text(text, encoding="utf-8", newline="\n")
        (draft / "vectors.csv").write_text(vectors_text(controller, run), encoding="utf-8", newline="\n")
        on_progress(1, 3, "compiling and running the bench")
        bench = compile_and_run(draft, made.bench) if compiler() is not None else None
        _remove_built(draft, made.files)
        found = FlightExport(
            folder, name, precision, controller, left, form, made.cost, made.bound, made.fixed, samples, bench
        )
        on_progress(2, 3, "writing")
        (draft / "report.txt").write_text(report_text(found) + "\n", encoding="utf-8", newline="\n")
        text = json.dumps(_manifest(found, choice, draft), indent=2, ensure_ascii=False)
        (draft / MANIFEST).write_text(text + "\n", encoding="utf-8")
    return found


@dataclass(frozen=True, slots=True)
class _Made:
    """The code of one precision, and the name that its bench goes by."""

    files: dict[str, str]
    bench: str
    cost: Operations | FixedOperations
    bound: RoundingBound | None
    fixed: FixedForm | None


def _code(of: FlightController, form: Sections, run: Vectors, name: str, precision: Precision) -> _Made:
    if precision == "fixed":
        fixed = quantised(of, form, run)
        return _Made(fixed_code(of, form, fixed, name), f"{name}_fixed", fixed_operations(of, fixed), None, fixed)
    bound = rounding_bound(of, form, run) if precision == "single" else None
    files = flight_code(of, form, name, precision, bound)
    return _Made(files, name, operations(of, form, precision), bound, None)


def _remove_built(folder: Path, sources: dict[str, str]) -> None:
    """Take away what the compiler left: the folder holds text, for any machine."""
    for path in folder.iterdir():
        if path.name not in sources and path.name != "vectors.csv":
            path.unlink()


def _manifest(of: FlightExport, choice: Choice, folder: Path) -> dict[str, Any]:
    files = sorted(path for path in folder.iterdir() if path.is_file())
    libraries = ("microrad", "numpy", "scipy", "numba", "jinja2")
    return {
        KIND: {"kind": "flight code", "name": of.name, "controller": of.controller.name, "precision": of.precision},
        "mission": {"file": choice.file.path.name, "sha256": choice.file.sha256, "name": of.controller.origin.mission},
        "samples": of.samples,
        "versions": {"python": platform.python_version(), **{each: version(each) for each in libraries}},
        "files_sha256": {path.name: hashlib.sha256(path.read_bytes()).hexdigest() for path in files},
    }


# ----------------------------------------------------------------------------------------------------------- in words
def report_text(of: FlightExport) -> str:
    """What was exported, what a step costs and how exact it is, in lines."""
    c = of.controller
    inputs = ", ".join(f"{each.name}[{each.size}]" for each in c.inputs)
    lines = [
        ("from", f"{c.origin.mission}, sha256 {c.origin.mission_sha256[:16]}"),
        ("mirror", c.origin.mirror),
        (
            "controller",
            f"{c.name}, {format_quantity(1.0 / c.period_s, 'Hz')}, {of.form.order} states in {of.form.form} form",
        ),
        ("reads", inputs),
        ("commands", f"{c.actuators} x {_limits(c)}"),
        ("margins", ", ".join(f"{name} {_shown(value, unit)}" for name, value, unit in c.margins)),
        *_residual(of),
        ("a step costs", of.cost.words),
        *_exactness(of),
        *_measured(of),
    ]
    text = "\n".join(f"  {name:13} {words}" for name, words in lines)
    quantisation = "" if of.fixed is None else f"\n\n{quantisation_text(of.fixed)}"
    return f"{of.name}: {c.name} in {_IN[of.precision]}\n{text}{quantisation}"


_IN = {"double": "double precision", "single": "single precision", "fixed": "fixed point"}


def _shown(value: float, unit: str) -> str:
    return format_quantity(value, unit, 3) if unit in ("s", "Hz") else f"{value:.3g} {unit}".strip()


def _limits(c: FlightController) -> str:
    low, high, bias = (format_quantity(v, "V", 6) for v in (c.minimum_v, c.maximum_v, c.bias_v))
    counts = f", in counts of {format_quantity(c.resolution_v, 'V')}" if c.resolution_v else ""
    return f"{low} to {high} from the bias of {bias}{counts}"


def _residual(of: FlightExport) -> list[tuple[str, str]]:
    if of.left is None:
        return []
    return [("leaves", f"{rms_text(of.left.linear_rad)} in linear theory, {rms_text(of.left.simulated_rad)} simulated")]


def _exactness(of: FlightExport) -> list[tuple[str, str]]:
    return [] if of.bound is None else [("single", of.bound.words)]


def _measured(of: FlightExport) -> list[tuple[str, str]]:
    if of.bench is None:
        return [("not compiled", "there is no C compiler here (cc, gcc, clang); make in the folder builds the bench")]
    b = of.bench
    counted = {"saturated": b.saturated, "rate-clamped": b.rate_clamped, "rejected": b.rejected, "faults": b.faults}
    counts = ", ".join(f"{count} {name}" for name, count in counted.items())
    difference, allowed = (format_quantity(v, "V", 3) for v in (b.largest_difference_v, b.bound_v))
    return [
        ("compiled, run", f"{b.samples} samples of the loop: at most {difference} off the kernel (allowed: {allowed})"),
        ("counters", counts),
        ("time a step", f"{b.worst_step_ns:.0f} ns at worst, {b.median_step_ns:.0f} ns in the median, on this machine"),
    ]


def data(of: FlightExport) -> dict[str, Any]:
    """The same for machines."""
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
        "bound": None if of.bound is None else asdict(of.bound),
        "bench": None if of.bench is None else asdict(of.bench),
    }
