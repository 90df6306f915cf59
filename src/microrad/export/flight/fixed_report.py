"""What fixed point costs: poles, response, noise of rounding and limit cycles of a quantised controller."""

import math

import numpy as np

from microrad.core import lti
from microrad.export.flight.double_run import Run, run
from microrad.export.flight.fixed_form import FixedForm, OutputQuality, Poles, QuantisationReport, Whole, dequantised
from microrad.export.flight.fixed_step import FixedRun, Step, fixed_run
from microrad.export.flight.rounding import behind_converter, errors_of_inverse, responses
from microrad.export.linear_part.sections import Sections
from microrad.export.records import FlightController, Floats

_REST_SAMPLES = 4096


def report(
    of: FlightController, form: Sections, made: FixedForm, inputs: Floats, ideal: Run, moved: Poles
) -> QuantisationReport:
    """What the fixed-point form ``made`` costs over a recorded run, which is ``ideal`` in double precision."""
    near, found = dequantised(form, made), fixed_run(of, made, inputs)
    low, high = of.minimum_v, of.maximum_v
    error = np.max(np.abs(np.clip(found.free, low, high) - np.clip(ideal.free, low, high)), axis=0)
    single = np.max(errors_of_inverse(of, form, ideal), axis=0) if of.inverse is not None else np.zeros(of.actuators)
    rest = np.maximum(np.max(np.abs(ideal.states), axis=0), 1e-300)
    ranges = np.ldexp(float(made.word), -np.array(made.state_scale, dtype=int))
    return QuantisationReport(
        samples=len(inputs),
        period_s=of.period_s,
        poles=moved,
        outputs=_qualities(of, form, near, made, found, run(of, near, inputs)),
        head_room_bits=tuple(float(np.log2(a / b)) for a, b in zip(ranges, rest, strict=True)),
        error_v=float(np.max(error)),
        inverse_v=float(np.max(single)),
        resolution_v=of.resolution_v,
        bound_v=float(np.max(behind_converter(of, error + single))),
    )


def _qualities(
    of: FlightController, form: Sections, near: Sections, made: FixedForm, found: FixedRun, exact: Run
) -> tuple[OutputQuality, ...]:
    response = _response_errors(of, form, near)
    cycles = _cycles(near, made, found.states)
    qualities = []
    for i, (name, unit) in enumerate(_output_names(of)):
        noise, bound = _noise(near, made, i, found.outputs.shape[0])
        measured = float(np.sqrt(np.mean((found.outputs[:, i] - exact.outputs[:, i]) ** 2)))
        qualities.append(OutputQuality(name, unit, *response[i], noise, measured, bound, float(cycles[i])))
    return tuple(qualities)


def _output_names(of: FlightController) -> list[tuple[str, str]]:
    kinds = [("v", "V"), ("target", "rad"), ("target's rate", "rad/s")]
    rows = 1 if of.inverse is None else 2 if of.inverse.by_difference else 3
    return [(f"{name} {a}", unit) for name, unit in kinds[:rows] for a in range(of.actuators)]


def _response_errors(of: FlightController, form: Sections, near: Sections) -> list[tuple[float, float]]:
    """Largest relative error of each output's response and the frequency where it is."""
    freq = np.geomspace(1e-5, 0.5, 600) / of.period_s
    resonances = np.abs(np.angle(np.linalg.eigvals(form.A))) / (2.0 * math.pi * of.period_s)
    freq = np.sort(np.concatenate([freq, resonances[resonances > freq[0]]]))
    of_form, of_near = (lti.StateSpace(s.A, s.B, s.C, s.D) for s in (form, near))
    before, after = (lti.frequency_response(s, freq, of.period_s) for s in (of_form, of_near))
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


def report_text(fixed: FixedForm) -> str:
    """The report on quantisation in words and tables, with units."""
    r = fixed.report
    count = f" (a count is {r.resolution_v:.3g} V)" if r.resolution_v > 0.0 else ""
    lines = [
        f"Words of {fixed.bits} bits, sums of 64. Ranges are at least {fixed.head_room:g} times the largest sizes in "
        f"{r.samples} recorded samples.",
        f"Commands stray from double precision by at most {r.error_v:.3g} V over them, ahead of the converter{count}.",
    ]
    if r.inverse_v > 0.0:
        lines.append(f"The inverse, in single precision, adds up to {r.inverse_v:.3g} V to that.")
    heading = ("output", "response", "at", "noise rms, predicted", "measured", "swing at rest, most", "found")
    outputs: list[tuple[str, ...]] = [heading]
    for o in r.outputs:
        noise = (f"{x:.2e} {o.unit}" for x in (o.noise_predicted, o.noise_measured))
        swing = (f"{x:.2e} {o.unit}" for x in (o.cycle_bound, o.cycle_found))
        outputs.append((o.name, _decibels(o.response_error), f"{o.at_hz:.4g} Hz", *noise, *swing))
    poles_table: list[tuple[str, ...]] = [("pole", "|z| as designed", "|z| as quantised")]
    for before, after in r.poles:
        hz = abs(np.angle(before)) / (2.0 * math.pi * r.period_s)
        poles_table.append((f"{hz:.4g} Hz", f"{abs(before):.15f}", f"{abs(after):.15f}"))
    states: list[tuple[str, ...]] = [("state", "head room", "a step is", "bits below")]
    for i, (room, scale, below) in enumerate(zip(r.head_room_bits, fixed.state_scale, fixed.state_shift, strict=True)):
        # A state that rests all the run is scaled by what the readings could do to it.
        states.append((str(i), f"{room:.1f} bits" if room < 64.0 else "at rest", f"2^{-scale}", str(below)))
    return "\n".join([*lines, "", *_table(outputs), "", *_table(poles_table), "", *_table(states)])


def _decibels(error: float) -> str:
    return f"{20.0 * math.log10(1.0 + error):.1e} dB"


def _table(rows: list[tuple[str, ...]]) -> list[str]:
    """Rows in columns two blanks apart, numbers to the right."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return ["  ".join(text.rjust(width) for text, width in zip(row, widths, strict=True)).rstrip() for row in rows]


def poles(form: Sections, made: FixedForm) -> Poles:
    """Poles as designed and as quantised, each with the nearest one of its block."""
    before, after, found = form.A, dequantised(form, made).A, []
    for first, size in form.blocks:
        block = slice(first, first + size)
        new = list(np.linalg.eigvals(after[block, block]).astype(complex))
        for pole in np.linalg.eigvals(before[block, block]).astype(complex):
            nearest = min(range(len(new)), key=lambda j, z=pole: abs(new[j] - z))  # type: ignore[misc]
            found.append((complex(pole), complex(new.pop(nearest))))
    return tuple(found)
