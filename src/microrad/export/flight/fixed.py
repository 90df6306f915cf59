"""Fixed point: the linear part of a controller as whole numbers, refused where it does not fit, and its C code."""

import math
from dataclasses import dataclass, replace
from importlib.metadata import version

import numpy as np

from microrad.core import kernels, lti
from microrad.export.flight.c_code import flight_code, start_words
from microrad.export.flight.double_run import run
from microrad.export.flight.fixed_form import HEAD_ROOM, FixedForm, Poles, scaled
from microrad.export.flight.fixed_report import poles, report, report_text
from microrad.export.flight.rounding import RoundingBound
from microrad.export.identifiers import identifier
from microrad.export.linear_part.sections import Sections
from microrad.export.records import ExportError, FlightController, Signal, Vectors
from microrad.export.templating import render

__all__ = ["FixedForm", "fixed_code", "quantised", "report_text"]

LEAST_BITS, MOST_BITS = 8, 32

_CIRCLE = 1e-12  # what rounding moves the size of a pole by


def quantised(
    of: FlightController,
    form: Sections,
    v: Vectors,
    bits: int = 32,
    *,
    head_room: float = HEAD_ROOM,
    beyond_a_count: bool = False,
) -> FixedForm:
    """The controller's linear part in fixed point, scaled by a recorded run, with its report.

    ``bits`` (8 to 32) are those of coefficients and signals; sums have 64. Raises ExportError for other bits, head room
    below 1, for poles that quantisation puts on or beyond the unit circle, for numbers that do not fit, and for
    commands that stray from double precision by more than a count of the converter unless ``beyond_a_count``.
    """
    if not LEAST_BITS <= bits <= MOST_BITS:
        raise ExportError(f"{bits} bits in fixed point: give {LEAST_BITS} to {MOST_BITS} (sums have 64)")
    if not (math.isfinite(head_room) and head_room >= 1.0):
        raise ExportError(f"a head room of {head_room:g} over the recorded run: give 1 or more (4 leaves two bits)")
    ideal = run(of, form, v.inputs)
    made = scaled(of, form, v.inputs, ideal, bits, head_room)
    _refuse_what_does_not_fit(of, made)
    moved = poles(form, made)
    _refuse_poles(of, made, moved)
    found = replace(made, report=report(of, form, made, v.inputs, ideal, moved))
    _refuse_strays(of, found, beyond_a_count)
    return found


def _refuse_what_does_not_fit(of: FlightController, made: FixedForm) -> None:
    worst = min((*made.state_shift, *made.output_shift), default=0)
    shifts = [c.shift for c in made.converter]
    if worst < 0 or any(not 1 <= s <= 62 for s in shifts) or max((*made.input_scale, *made.state_scale)) > 1000:
        raise ExportError(
            f"controller {of.name!r} does not fit into words of {made.bits} bits: the numbers of a row are "
            f"2^{-worst} beyond the range of its sum; give more bits (up to {MOST_BITS}), or export single precision"
        )


def _refuse_poles(of: FlightController, made: FixedForm, moved: Poles) -> None:
    for before, after in moved:
        inside = abs(before) < 1.0 - _CIRCLE
        if (inside and abs(after) >= 1.0) or abs(after) > 1.0 + _CIRCLE:
            hz = abs(np.angle(before)) / (2.0 * math.pi * of.period_s)
            raise ExportError(
                f"controller {of.name!r} in words of {made.bits} bits: the pole of |z| = {abs(before):.9f} at {hz:.4g} "
                f"Hz moves to |z| = {abs(after):.9f}, and the limit is 1; give more bits (up to {MOST_BITS}) or less "
                "head room, or export single precision"
            )


def _refuse_strays(of: FlightController, found: FixedForm, beyond_a_count: bool) -> None:
    r = found.report
    if of.resolution_v > 0.0 and r.error_v > of.resolution_v and not beyond_a_count:
        raise ExportError(
            f"controller {of.name!r} in words of {found.bits} bits commands up to {r.error_v:.3g} V off double "
            f"precision over {r.samples} samples, more than a count of the converter ({of.resolution_v:.3g} V); give "
            f"more bits (up to {MOST_BITS}), or say that more than a count will do"
        )


# ----------------------------------------------------------------------------------------------------------------- code
@dataclass(frozen=True, slots=True)
class Constant:
    """A scale with its name: ``NAME`` in C, the first and number of its numbers, unit, and SI units a whole number."""

    NAME: str
    first: int
    size: int
    unit: str
    words: str
    scale: int

    @property
    def value(self) -> float:
        """SI units to a whole number."""
        return math.ldexp(1.0, -self.scale)


def fixed_code(of: FlightController, form: Sections, fixed: FixedForm, name: str) -> dict[str, str]:
    """The fixed-point form as C99: {name}_fixed.h, {name}_fixed.c, their bench and Makefile; file names and texts.

    With an inverse, {name}_inverse.h, .c and _hysteresis.h in single precision come with it. Raises ExportError for a
    name that is no identifier.
    """
    whole = identifier(f"{identifier(name)}_fixed")
    values = {
        "name": name,
        "version": version("microrad"),
        "of": of,
        "fixed": fixed,
        "inputs": _input_constants(of, fixed),
        "outputs": _output_constants(of, fixed),
        "tables": _tables(form, fixed),
        "report": report_text(fixed).splitlines(),
        "start": start_words(of, rejects=False),
    }
    files = {
        f"{whole}.h": render("fixed.h.j2", **values),
        f"{whole}.c": render("fixed.c.j2", **values),
        f"{whole}_bench.c": render("fixed_bench.c.j2", **values),
    }
    inverse = {} if of.inverse is None else _inverse_code(of, fixed, identifier(f"{name}_inverse"))
    headers, sources = ([file for file in (*files, *inverse) if file.endswith(end)] for end in (".h", ".c"))
    make = render("Makefile.j2", name=whole, version=version("microrad"), headers=headers, sources=sources)
    return {**files, **inverse, "Makefile": make}


def _input_constants(of: FlightController, fixed: FixedForm) -> list[Constant]:
    found, first = [], 0
    for s in of.inputs:
        scale = fixed.input_scale[first]
        found.append(Constant(s.name.upper(), first, s.size, s.unit, f"{s.name}: {s.meaning}", scale))
        first += s.size
    return found


def _output_constants(of: FlightController, fixed: FixedForm) -> list[Constant]:
    n, rows = of.actuators, len(fixed.output_scale) // of.actuators
    kinds = [
        ("V", "V", "v: the command" + ("" if of.inverse is None else " without what the inverse adds")),
        ("TARGET_RAD", "rad", "target of the inverse"),
        ("RATE_RAD_S", "rad/s", "rate of the inverse's target"),
    ]
    scales = fixed.output_scale[::n]
    return [Constant(key, j * n, n, unit, words, scales[j]) for j, (key, unit, words) in enumerate(kinds[:rows])]


def _tables(form: Sections, fixed: FixedForm) -> dict[str, list[tuple[int, int, int]]]:
    """Numbers that are not 0, as (row, column, weight), by matrix."""
    n, m = form.order, form.B.shape[1]
    parts = {
        "C": fixed.output.value[:, :n],
        "D": fixed.output.value[:, n:],
        "A": fixed.state.value[:, :n],
        "B": fixed.state.value[:, n : n + m],
        "L": fixed.state.value[:, n + m :],
    }
    return {key: [(int(i), int(j), int(part[i, j])) for i, j in np.argwhere(part)] for key, part in parts.items()}


def _inverse_code(of: FlightController, fixed: FixedForm, name: str) -> dict[str, str]:
    """The inverse alone, in single precision: target and rate in, what it adds to the commands out, not clipped."""
    assert of.inverse is not None
    n, rows = of.actuators, len(fixed.output_scale)
    ends = [math.ldexp(1.001 * fixed.word, -fixed.output_scale[j * n]) for j in range(1, rows // n)]
    signals = (
        Signal("wanted_rad", n, "rad", "target, by actuator", ends[0]),
        *(Signal("wanted_rate_rad_s", n, "rad/s", "rate of the target, by actuator", end) for end in ends[1:]),
    )
    D = np.vstack([np.zeros((n, rows - n)), np.eye(rows - n)])
    nothing = np.zeros((0, 0))
    form = Sections("modal", (), np.zeros(0), np.zeros(0), kernels.rows(nothing), np.zeros((0, rows - n)),
        np.zeros((rows, 0)), D, np.zeros((0, n)), 1.0)  # fmt: skip
    alone = replace(
        of,
        name=f"inverse of {of.name}",
        inputs=signals,
        system=lti.StateSpace(nothing, form.B, form.C, D),
        anti_windup=form.L,
        minimum_v=-math.inf,
        maximum_v=math.inf,
        resolution_v=0.0,
        margins=(),
    )
    bound = RoundingBound(fixed.report.bound_v, fixed.report.samples, 0.0, "The bench of fixed point holds it.")
    files = flight_code(alone, form, name, "single", bound)
    return {file: text for file, text in files.items() if file != "Makefile" and not file.endswith("_bench.c")}
