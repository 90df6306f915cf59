"""Flight code: a controller as C99 with its make file and test bench, and the recorded run that goes with it."""

import math
import re
from dataclasses import asdict, dataclass, replace
from importlib.metadata import version
from typing import Any

import numpy as np

from microrad.core import kernels
from microrad.export.flight.learning_rounding import RUNS, SIGMAS
from microrad.export.flight.rounding import RoundingBound
from microrad.export.identifiers import identifier
from microrad.export.linear_part.sections import Sections, compensated_states
from microrad.export.records import AdaptiveLaw, ExportError, FlightController, InverseLaw, Signal, Vectors
from microrad.export.templating import Precision, entries, render

BOUND_SHARE = 1e-12
"""In double precision the code agrees with the kernel within this share of the largest command."""

POWER_BOUND_SHARE = 1e-10
"""The same where an exponent of Bouc-Wen is not 1: each of the two integrates to 1e-11 of h's size a step."""


def flight_code(
    of: FlightController, form: Sections, name: str, precision: Precision, bound: RoundingBound | None = None
) -> dict[str, str]:
    """The controller with its linear part in ``form`` as C99: file names and texts.

    Files: the code, {name}.h and {name}.c, with {name}_hysteresis.h where it has an inverse or a feedforward; a test
    bench that replays a recorded run (`vectors_text`), and a Makefile.

    Args:
        of: The controller.
        form: Its linear part.
        name: What the code is called, an identifier of C.
        precision: "double" or "single".
        bound: What single precision may differ by over the recorded run.

    Raises:
        ExportError: A name that is no identifier; limits between which no command lies; numbers beyond the precision;
            single precision without a bound.
    """
    values = _values(of, form, identifier(name), precision)
    if precision == "single":
        if bound is None:
            raise ExportError(
                f"controller {of.name!r} in single precision: no bound on its rounding is given, so that the bench has "
                "nothing to hold it to; find it with rounding_bound, or export double precision"
            )
        values |= {"bound": bound, "unbounded": bound.command_v >= of.maximum_v - of.minimum_v}
    templates = {
        f"{name}.h": "controller.h.j2",
        f"{name}.c": "controller.c.j2",
        f"{name}_bench.c": "bench.c.j2",
        "Makefile": "Makefile.j2",
    }
    if of.inverse is not None or of.forward is not None:
        templates[f"{name}_hysteresis.h"] = "hysteresis.h.j2"
    headers, sources = ([file for file in templates if file.endswith(end)] for end in (".h", ".c"))
    return {file: render(template, headers=headers, sources=sources, **values) for file, template in templates.items()}


def within_limits(of: FlightController, v: Vectors) -> Vectors:
    """The recorded run with its commands held within what the code can give.

    The kernel rounds a limit to the nearest count of the converter, the code to the next one inwards.

    Args:
        of: The controller, for its limits and resolution (V).
        v: The recorded run.

    Raises:
        ExportError: Where no command lies between the limits.
    """
    limits = _limits(of, "double")
    return replace(v, commands=np.clip(v.commands, limits.lowest, limits.highest))


def vectors_text(of: FlightController, v: Vectors) -> str:
    """The recorded run as the text that the bench reads: a heading, then readings and commands of one sample a line.

    Numbers have all their digits.

    Args:
        of: The controller, for the names of its inputs.
        v: The recorded run.
    """
    names = [f"{each.name}_{i}" for each in of.inputs for i in range(each.size)]
    names += [f"command_v_{a}" for a in range(of.actuators)]
    rows = np.hstack([v.inputs, v.commands]).tolist()
    return "\n".join([",".join(names), *(",".join(f"{x:.17g}" for x in row) for row in rows)]) + "\n"


# ----------------------------------------------------------------------------------------------- what the templates get
@dataclass(frozen=True, slots=True)
class Limits:
    """Commands (V from the bias): limits, resolution of the converter, and the outermost values it can give."""

    minimum: float
    maximum: float
    resolution: float
    lowest: float
    highest: float

    @property
    def rest(self) -> float:
        """The command nearest to 0."""
        return min(max(0.0, self.lowest), self.highest)


def _values(of: FlightController, form: Sections, name: str, precision: Precision) -> dict[str, Any]:
    kept = np.array(compensated_states(form), dtype=bool) & (precision == "single")
    elements = 0 if of.forward is None else of.forward.drives.shape[1]
    kinds = ["v (V)", "target (rad)", "rate of the target (rad/s)", "error of the reading (rad)"][
        : (form.C.shape[0] - elements) // of.actuators
    ]
    rows = ([*kinds, "drive of each element"], [of.actuators] * len(kinds) + [elements])
    sizes = [size for _, size in form.blocks]
    moves = form.A - np.diag(kept.astype(float))
    drives = np.zeros((of.actuators, 0)) if of.forward is None else of.forward.drives
    matrices = {"A": moves, "B": form.B, "C": form.C, "D": form.D, "L": form.L, "forward": drives}
    return {
        "name": name,
        "precision": precision,
        "version": version("microrad"),
        "of": of,
        "limits": _limits(of, precision),
        "signals": _readings(of.inputs),
        "readings": sum(each.size for each in of.inputs),
        "outputs": form.C.shape[0],
        "form": form,
        "states": form.order,
        "compensated": kept.tolist() if np.any(kept) else [],
        "all_compensated": bool(np.any(kept) and np.all(kept)),
        "rows": _places(*rows) if elements else _places(kinds, [of.actuators] * len(kinds)),
        "columns": _places([each.name for each in of.inputs], [each.size for each in of.inputs]),
        "block_sizes": [(n, sizes.count(n)) for n in sorted(set(sizes))],
        "weights": {key: entries(matrix) for key, matrix in matrices.items()},
        "bound_share": bound_share(of),
        **_inverse_values(of.inverse),
        **_forward_values(of.forward),
        **_adaptive_values(of.adaptation),
    }


def bound_share(of: FlightController) -> float:
    """Largest difference of a command in double precision from the kernel's, over the largest command of the run."""
    rows = [each.bouc_wen for each in (of.inverse, of.forward) if each is not None]
    return POWER_BOUND_SHARE if any(np.any(row[:, kernels.POWER]) for row in rows) else BOUND_SHARE


def _places(names: list[str], sizes: list[int]) -> str:
    """Names with the rows or columns that they stand for."""
    ends = np.cumsum(sizes).tolist()
    return ", ".join(
        f"{name} {end - size}" + (f" to {end - 1}" if size > 1 else "")
        for name, size, end in zip(names, sizes, ends, strict=True)
    )


def _readings(inputs: tuple[Signal, ...]) -> list[dict[str, Any]]:
    """The inputs as the templates write them: place among the readings, name and unit in constants beside the rest."""
    found, first = [], 0
    for s in inputs:
        unit = re.sub(r"[^A-Z0-9]+", "_", s.unit.upper())  # rad/s: RAD_S
        plain = s.name.upper().removesuffix(f"_{unit}")
        found.append({**asdict(s), "first": first, "NAME": plain, "UNIT": unit})
        first += s.size
    return found


def _limits(of: FlightController, precision: Precision) -> Limits:
    """Limits that the precision holds, never outside the controller's own."""
    low, high, step = _inwards(of.minimum_v, math.inf, precision), _inwards(of.maximum_v, -math.inf, precision), 0.0
    lowest, highest = low, high
    if of.resolution_v > 0.0:
        # A limit that is a multiple of the resolution up to rounding is one that the converter gives.
        step, near = of.resolution_v, 1e-6
        lowest = max(low, math.ceil(low / step - near) * step) if math.isfinite(low) else low
        highest = min(high, math.floor(high / step + near) * step) if math.isfinite(high) else high
    if not lowest <= highest:
        raise ExportError(
            f"controller {of.name!r}: no command lies between its limits of {of.minimum_v:g} V and {of.maximum_v:g} V"
            + (f" at a resolution of {of.resolution_v:g} V" if of.resolution_v > 0.0 else "")
            + "; see the mission's amplifier, bias and drive_resolution"
        )
    return Limits(low, high, step, lowest, highest)


def _inwards(limit: float, towards: float, precision: Precision) -> float:
    """A limit in the precision, rounded to the side ``towards``."""
    if precision == "double" or math.isinf(limit):
        return limit
    held = np.float32(limit)
    outside = float(held) > limit if towards < 0 else float(held) < limit
    return float(np.nextafter(held, np.float32(towards)) if outside else held)


def _inverse_values(of: InverseLaw | None) -> dict[str, Any]:
    if of is None:
        return {"inverse": None, "elements": 0, "plays": 0, "lags": 0, "widening": False, "direct": False}
    elements, plays = of.bouc_wen.shape[0], of.play_threshold.size
    widening = plays > 0 and bool(np.any(of.widening[:, 0]))
    return {
        "inverse": of,
        "elements": elements,
        "plays": plays,
        "lags": of.lag_keep.size,
        "lag_share": 1.0 - of.lag_keep,
        "widening": widening,
        "direct": bool(np.any(of.direct)),
        "uses_rate": elements > 0 or widening,
    }


def _forward_values(of: kernels.ForwardBank | None) -> dict[str, Any]:
    if of is None:
        return {"forward_count": 0, "forward_elements": 0, "forward_operators": 0, "forward_plays": 0}
    reach = of.operator[:, kernels.REACH]
    return {
        "forward_count": of.drives.shape[1],
        "forward_elements": len(of.bouc_wen),
        "forward_operators": len(of.operator),
        "forward_plays": of.play_threshold.size,
        "forward_widens": bool(np.any(of.operator[:, kernels.WIDENING])),
        "forward_bends": bool(np.any(np.isfinite(reach))),
        "forward_polynomial": of.operator[:, kernels.REACH - 3 : kernels.REACH],
        "forward_reach": np.where(np.isfinite(reach), reach, 1.0),
    }


def _adaptive_values(of: AdaptiveLaw | None) -> dict[str, Any]:
    """What learns takes the place of the frozen inverse's direct gain and plays."""
    if of is None:
        return {"adaptive": None}
    law = {name: of.settings[:, getattr(kernels, name.upper())] for name in _SETTINGS if name != "forgotten"}
    law["forgotten"] = 1.0 - of.settings[:, kernels.KEEP]
    cycle, delay = (int(of.settings[0, column]) for column in (kernels.CYCLE, kernels.DELAY))
    values = {"TAKE_UP": kernels.TAKE_UP, "KEEP_UP": kernels.KEEP_UP, "SUSPECT": kernels.SUSPECT}
    return {
        "adaptive": of,
        "law": law,
        "cycle": cycle,
        "reading_delay": delay,
        "settings": _SETTINGS,
        "shares": values,
        "bound_sigmas": SIGMAS,
        "bound_runs": RUNS,
        "learners": of.weight.size,
        "slopes": np.concatenate([np.cumsum(w) for w in np.split(of.weight, of.start[1:-1])]),
        "plays": 0,
        "direct": False,
    }


_SETTINGS = {
    "gain": "share of the error that an update takes away",
    "share": "what the slow error follows in a period",
    "forgotten": "share of a mean that the next cycle replaces",
    "dead_zone": "rad, of the reading's noise",
    "speed": "rad/V, the most that a weight changes in a cycle",
    "least_size": "V^2, added to the plays' mean square",
    "least_travel": "V, from which on a play counts as excited",
    "least_weight": "rad/V, of the first play",
    "most_weight": "rad/V",
    "offset_limit": "rad, of the slow error",
}
