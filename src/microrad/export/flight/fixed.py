"""Fixed point: the linear part of a controller as whole numbers, what that costs, refusals, and its C code."""

import math
from dataclasses import replace
from importlib.metadata import version
from typing import Any

import numpy as np

from microrad.core import lti
from microrad.core.arrays import Floats
from microrad.export.flight.c_code import flight_code
from microrad.export.flight.double_run import Run, run_in_double
from microrad.export.flight.fixed_form import (
    HEAD_ROOM,
    FixedForm,
    OutputQuality,
    Poles,
    QuantisationReport,
    Step,
    Whole,
    dequantised,
    fixed_run,
    output_groups,
    scaled,
)
from microrad.export.flight.rounding import RoundingBound, behind_converter, errors_of_inverse, responses
from microrad.export.identifiers import identifier
from microrad.export.linear_part.sections import Sections
from microrad.export.records import ExportError, FlightController, Signal, Vectors
from microrad.export.templating import entries, render

LEAST_BITS, MOST_BITS = 8, 32

_REST_SAMPLES = 4096  # of a rest that limit cycles are looked for in
_CIRCLE = 1e-12  # what rounding moves the size of a pole by
_INTEGRATOR = 2.0**-lti.EXACT_BITS  # distance from 1 of an integrator: designs round their matrices to so many bits


def quantised(
    of: FlightController,
    form: Sections,
    v: Vectors,
    bits: int = 32,
    *,
    beyond_a_count: bool = False,
) -> FixedForm:
    """The controller's linear part in fixed point, scaled by a recorded run, with its report.

    Args:
        of: The controller.
        form: Its linear part.
        v: The recorded run; each number gets a range of `HEAD_ROOM` times its largest size there.
        bits: Bits of coefficients and signals, 8 to 32; sums have 64.
        beyond_a_count: Accept commands that stray from double precision by more than a count of the converter.

    Raises:
        ExportError: Other bits; a pole that quantisation puts on or beyond the unit circle; numbers that do not fit;
            commands that stray by more than a count.
    """
    if not LEAST_BITS <= bits <= MOST_BITS:
        raise ExportError(f"{bits} bits in fixed point: give {LEAST_BITS} to {MOST_BITS} (sums have 64)")
    ideal = run_in_double(of, form, v.inputs)
    exact = _with_integrators(form)
    made = scaled(of, exact, v.inputs, ideal, bits)
    _refuse_what_does_not_fit(of, made)
    moved = _poles(exact, made)
    _refuse_poles(of, made, moved)
    found = replace(made, report=_report(of, form, made, v.inputs, ideal, moved))
    r = found.report
    if of.resolution_v > 0.0 and r.error_v > of.resolution_v and not beyond_a_count:
        raise ExportError(
            f"controller {of.name!r} in words of {found.bits} bits commands up to {r.error_v:.3g} V off double "
            f"precision over {r.samples} samples, more than a count of the converter ({of.resolution_v:.3g} V); give "
            f"more bits (up to {MOST_BITS}), or say that more than a count will do"
        )
    return found


def _with_integrators(form: Sections) -> Sections:
    """The form with poles exactly at 1 where the rounding of a design has moved an integrator off it."""
    A = form.A.copy()
    for first, size in form.blocks:
        if size == 1 and abs(A[first, first] - 1.0) < _INTEGRATOR:
            A[first, first] = 1.0
    return replace(form, A=A)


def _refuse_what_does_not_fit(of: FlightController, made: FixedForm) -> None:
    worst = min((*made.state_shift, *made.output_shift), default=0)
    shifts = [c.shift for c in made.converter]
    if worst < 0 or any(not 1 <= s <= 62 for s in shifts) or max((*made.input_scale, *made.state_scale)) > 1000:
        beyond = f"the numbers of a row are 2^{-worst} beyond the range of its sum"
        why = beyond if worst < 0 else "a count of its converter, or a number in the run, is nothing beside its words"
        raise ExportError(
            f"controller {of.name!r} does not fit into words of {made.bits} bits: {why}; give more bits (up to "
            f"{MOST_BITS}), or export single precision"
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


# -------------------------------------------------------------------------------------------------------- what it costs
def _poles(form: Sections, made: FixedForm) -> Poles:
    """Poles as designed and as quantised, each with the nearest one of its block."""
    before, after, found = form.A, dequantised(form, made).A, []
    for first, size in form.blocks:
        block = slice(first, first + size)
        new = list(np.linalg.eigvals(after[block, block]).astype(complex))
        for pole in np.linalg.eigvals(before[block, block]).astype(complex):
            nearest = min(range(len(new)), key=lambda j, z=pole: abs(new[j] - z))  # type: ignore[misc]
            found.append((complex(pole), complex(new.pop(nearest))))
    return tuple(found)


def _report(
    of: FlightController, form: Sections, made: FixedForm, inputs: Floats, ideal: Run, moved: Poles
) -> QuantisationReport:
    """What the fixed-point form ``made`` costs over a recorded run, which is ``ideal`` in double precision."""
    near, (outputs, free, states) = dequantised(form, made), fixed_run(of, made, inputs)
    low, high = of.minimum_v, of.maximum_v
    error = np.max(np.abs(np.clip(free, low, high) - np.clip(ideal.free, low, high)), axis=0)
    single = np.max(errors_of_inverse(of, form, ideal), axis=0) if beside(of) else np.zeros(of.actuators)
    rest = np.maximum(np.max(np.abs(ideal.states), axis=0), 1e-300)
    ranges = np.ldexp(float(made.word), -np.array(made.state_scale, dtype=int))
    return QuantisationReport(
        samples=len(inputs),
        period_s=of.period_s,
        poles=moved,
        outputs=_qualities(of, form, near, made, outputs - run_in_double(of, near, inputs).outputs, states),
        head_room_bits=tuple(float(np.log2(a / b)) for a, b in zip(ranges, rest, strict=True)),
        error_v=float(np.max(error)),
        inverse_v=float(np.max(single)),
        resolution_v=of.resolution_v,
        bound_v=float(np.max(behind_converter(of, error + single))),
    )


def _qualities(
    of: FlightController, form: Sections, near: Sections, made: FixedForm, wrong: Floats, states: Whole
) -> tuple[OutputQuality, ...]:
    """By output; ``wrong`` are its errors over the run, and ``states`` those at the end of it."""
    response, cycles = _response_errors(of, form, near), _cycles(near, made, states)
    kinds, qualities = [(kind, unit, j) for kind, unit, size in output_groups(of) for j in range(size)], []
    for i, (kind, unit, j) in enumerate(kinds):
        noise, bound = _noise(near, made, i, len(wrong))
        measured = float(np.sqrt(np.mean(wrong[:, i] ** 2)))
        qualities.append(OutputQuality(f"{kind} {j}", unit, *response[i], noise, measured, bound, float(cycles[i])))
    return tuple(qualities)


def _response_errors(of: FlightController, form: Sections, near: Sections) -> list[tuple[float, float]]:
    """Largest relative error of each output's response and the frequency where it is."""
    freq = np.geomspace(1e-5, 0.5, 600) / of.period_s
    resonances = np.abs(np.angle(np.linalg.eigvals(form.A))) / (2.0 * math.pi * of.period_s)
    resonances *= 1.0 + 1e-9  # an undamped oscillator has no response at its own
    freq = np.sort(np.concatenate([freq, resonances[resonances > freq[0]]]))
    before, after = (lti.frequency_response(s.system, freq, of.period_s) for s in (form, near))
    size, wrong = np.linalg.norm(before, axis=2), np.linalg.norm(after - before, axis=2)
    relative = np.divide(wrong, size, out=np.zeros_like(size), where=size > 0.0)
    at = np.argmax(relative, axis=0)
    return [(float(relative[k, i]), float(freq[k])) for i, k in enumerate(at)]


def _noise(near: Sections, made: FixedForm, i: int, samples: int) -> tuple[float, float]:
    """Rms noise of output i for independent roundings of readings, states and output, and the largest swing that those
    of states and output can sum up to, whatever their pattern."""
    reach = responses(near.C[i], near.A, samples)
    by_state = np.vstack([near.C[i], reach @ (near.A - np.eye(near.order))])  # C (z - A)^-1 (A - 1) + C
    by_input = np.vstack([near.D[i], reach @ near.B])
    state, reading = (np.exp2(-np.array(s, dtype=float)) for s in (made.state_scale, made.input_scale))
    power = np.sum(by_state**2 @ state**2) + np.sum(by_input**2 @ reading**2) + 4.0 ** -made.output_scale[i]
    return math.sqrt(power / 12.0), float(np.sum(np.abs(by_state) @ state)) + 2.0 ** -made.output_scale[i]


def _cycles(near: Sections, made: FixedForm, states: Whole) -> Floats:
    """Swing of each output about the exact response, peak to peak, over the end of a rest from ``states``."""
    step, nothing = Step(made, states), np.zeros(len(made.input_scale), dtype=np.int64)
    still = np.zeros(near.L.shape[1], dtype=np.int64)
    outputs = np.empty((_REST_SAMPLES, near.C.shape[0]))
    for k in range(_REST_SAMPLES):
        outputs[k] = step.output(nothing)
        step.update(still)
    begin = np.ldexp(states.astype(float), -np.array(made.state.scale, dtype=int))
    exact = np.stack([responses(row, near.A, _REST_SAMPLES) @ begin for row in near.C], axis=1)
    wrong = (np.ldexp(outputs, -np.array(made.output_scale, dtype=int)) - exact)[-_REST_SAMPLES // 4 :]
    return np.asarray(np.ptp(wrong, axis=0))


def quantisation_text(fixed: FixedForm) -> str:
    """The report on quantisation in words and tables, with units."""
    r = fixed.report
    count = f" (a count is {r.resolution_v:.3g} V)" if r.resolution_v > 0.0 else ""
    lines = [
        f"Words of {fixed.bits} bits, sums of 64. Ranges are at least {HEAD_ROOM:g} times the largest sizes in "
        f"{r.samples} recorded samples.",
        f"Commands stray from double precision by at most {r.error_v:.3g} V over them, ahead of the converter{count}.",
    ]
    if r.inverse_v > 0.0:
        what = "feedforward" if any(o.name.startswith("drive") for o in r.outputs) else "inverse"
        lines.append(f"The {what}, in single precision, adds up to {r.inverse_v:.3g} V to that.")
    heading = ("output", "response", "at", "noise rms, predicted", "measured", "swing at rest, most", "found")
    outputs: list[tuple[str, ...]] = [heading]
    for o in r.outputs:
        noise = (f"{x:.2e} {o.unit}" for x in (o.noise_predicted, o.noise_measured))
        swing = (f"{x:.2e} {o.unit}" for x in (o.cycle_bound, o.cycle_found))
        response = f"{20.0 * math.log10(1.0 + o.response_error):.1e} dB"
        outputs.append((o.name, response, f"{o.at_hz:.4g} Hz", *noise, *swing))
    poles_table: list[tuple[str, ...]] = [("pole", "|z| as designed", "|z| as quantised")]
    for before, after in r.poles:
        hz = abs(np.angle(before)) / (2.0 * math.pi * r.period_s)
        poles_table.append((f"{hz:.4g} Hz", f"{abs(before):.15f}", f"{abs(after):.15f}"))
    states: list[tuple[str, ...]] = [("state", "head room", "a step is", "bits below")]
    for i, (room, scale, below) in enumerate(zip(r.head_room_bits, fixed.state_scale, fixed.state_shift, strict=True)):
        # A state that rests all the run is scaled by what the readings could do to it.
        states.append((str(i), f"{room:.1f} bits" if room < 64.0 else "at rest", f"2^{-scale}", str(below)))
    return "\n".join([*lines, "", *_table(outputs), "", *_table(poles_table), "", *_table(states)])


def _table(rows: list[tuple[str, ...]]) -> list[str]:
    """Rows in columns two blanks apart, numbers to the right."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return ["  ".join(text.rjust(width) for text, width in zip(row, widths, strict=True)).rstrip() for row in rows]


# ----------------------------------------------------------------------------------------------------------------- code
def _constant(name: str, first: int, size: int, unit: str, words: str, scale: int) -> dict[str, Any]:
    """A scale for the templates: name in C, the first and number of its numbers, unit, SI units a whole number."""
    value = math.ldexp(1.0, -scale)
    return {"NAME": name, "first": first, "size": size, "unit": unit, "words": words, "scale": scale, "value": value}


def fixed_code(of: FlightController, form: Sections, fixed: FixedForm, name: str) -> dict[str, str]:
    """The fixed-point form as C99: {name}_fixed.h, {name}_fixed.c, their bench and Makefile; texts by file name.

    With an inverse or a feedforward, {name}_inverse.h (_feedforward.h), .c and _hysteresis.h in single precision come
    with it.

    Args:
        of: The controller.
        form: Its linear part.
        fixed: The same in fixed point, see `quantised`.
        name: What the code is called, an identifier of C that leaves room for "_fixed".

    Raises:
        ExportError: For a name that is no identifier.
    """
    whole = identifier(f"{identifier(name)}_fixed")
    n, m = form.order, form.B.shape[1]
    parts = {
        "C": fixed.output.value[:, :n],
        "D": fixed.output.value[:, n:],
        "A": fixed.state.value[:, :n],
        "B": fixed.state.value[:, n : n + m],
        "L": fixed.state.value[:, n + m :],
    }
    inputs: list[dict[str, Any]] = []
    first = 0
    for s in of.inputs:
        inputs.append(
            _constant(s.name.upper(), first, s.size, s.unit, f"{s.name}: {s.meaning}", fixed.input_scale[first])
        )
        first += s.size
    values = {
        "name": name,
        "version": version("microrad"),
        "of": of,
        "beside": beside(of),
        "fixed": fixed,
        "inputs": inputs,
        "outputs": _output_constants(of, fixed),
        "tables": {key: entries(part) for key, part in parts.items()},
        "report": quantisation_text(fixed).splitlines(),
    }
    files = {f"{name}_{file}": render(f"{file}.j2", **values) for file in ("fixed.h", "fixed.c", "fixed_bench.c")}
    inverse = _code_beside(of, fixed, identifier(f"{name}_{beside(of)}")) if beside(of) else {}
    headers, sources = ([file for file in (*files, *inverse) if file.endswith(end)] for end in (".h", ".c"))
    make = render("Makefile.j2", name=whole, version=version("microrad"), headers=headers, sources=sources)
    return {**files, **inverse, "Makefile": make}


def beside(of: FlightController) -> str:
    """What works in single precision beside the linear part: "inverse", "feedforward" or nothing."""
    return "inverse" if of.inverse is not None else "feedforward" if of.forward is not None else ""


def _output_constants(of: FlightController, fixed: FixedForm) -> list[dict[str, Any]]:
    words = {
        "v": ("V", "v: the command" + (f" without what the {beside(of)} adds" if beside(of) else "")),
        "target": ("TARGET_RAD", "target of the inverse"),
        "target's rate": ("RATE_RAD_S", "rate of the inverse's target"),
        "error of the reading": ("UNEXPECTED_RAD", "reading less what the targets make expect"),
        "drive of hysteresis": ("MOTION", "what drives each element of hysteresis"),
    }
    found, first = [], 0
    for kind, unit, size in output_groups(of):
        key, said = words[kind]
        found.append(_constant(key, first, size, unit, said, fixed.output_scale[first]))
        first += size
    return found


def _code_beside(of: FlightController, fixed: FixedForm, name: str) -> dict[str, str]:
    """The inverse or the feedforward alone, in single precision: what drives it in, what it adds out, not clipped."""
    n, rows = of.actuators, len(fixed.output_scale)
    words = {
        "target": ("wanted_rad", "target, by actuator"),
        "target's rate": ("wanted_rate_rad_s", "rate of the target, by actuator"),
        "error of the reading": ("unexpected_error_rad", "reading less what the targets make expect, by actuator"),
        "drive of hysteresis": ("motion", "what drives each element of hysteresis"),
    }
    signals: tuple[Signal, ...] = ()
    for kind, unit, size in output_groups(of)[1:]:
        key, said = words[kind]
        end = math.ldexp(1.001 * fixed.word, -fixed.output_scale[n + sum(each.size for each in signals)])
        signals += (Signal(key, size, unit, said, end),)
    D = np.vstack([np.zeros((n, rows - n)), np.eye(rows - n)])
    nothing = np.zeros((0, 0))
    B, C, L = np.zeros((0, rows - n)), np.zeros((rows, 0)), np.zeros((0, n))
    form = Sections("modal", (), nothing, B, C, D, L)
    alone = replace(
        of,
        name=f"{beside(of)} of {of.name}",
        inputs=signals,
        system=form.system,
        anti_windup=L,
        minimum_v=-math.inf,
        maximum_v=math.inf,
        resolution_v=0.0,
        margins=(),
    )
    bound = RoundingBound(fixed.report.bound_v, fixed.report.samples, 0.0, "The bench of fixed point holds it.")
    files = flight_code(alone, form, name, "single", bound)
    return {file: text for file, text in files.items() if file != "Makefile" and not file.endswith("_bench.c")}
