"""A mirror file of version 2: a mirror of several axes, with its channels, its recordings and what is known of it.

    x' = A x + B u + E z        q = F x + G u        z = H[q]        y = C x + D u + K z

Column j of B, D and G belongs to actuator j, row i of C, D and K to output i, row e of F and G and column e of E and K
to hysteresis element e. A is made of the modes. Matrices are plain numbers in SI units.
"""

import difflib
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from typing import Annotated, Any

from pydantic import Field

from microrad.mission.fields import Problem, Table, Whole
from microrad.mission.tables.coupled_parts import (
    ActuatorTable,
    Count,
    HysteresisTable,
    MatricesTable,
    ModesTable,
    OutputTable,
    RecordingTable,
    UncertaintyTable,
    shape_problems,
)
from microrad.mission.tables.mirror import Name

MATRICES = "BCDEFGK"
_ON_A_LINE = 1e-4  # places whose spread across their line is at most this part of that along it lie on one


class CoupledMirror(Table):
    """A mirror of several axes: its channels, its modes and matrices, its hysteresis, and how it was recorded."""

    version: Annotated[int, Whole("", least=2, most=2)] = Field(description="2: a mirror of several axes")
    name: Name = Field(description="what the report calls the mirror")
    actuators: dict[str, ActuatorTable] = Field(description="one table for each, [actuators.1] and so on")
    outputs: dict[str, OutputTable] = Field(description="one table for each, [outputs.1] and so on")
    recording: RecordingTable
    modes: ModesTable | None = Field(default=None, description="left out for a mirror without dynamics")
    matrices: MatricesTable
    hysteresis: dict[str, HysteresisTable] = Field(
        default={}, description="one table for each element, [hysteresis.1] and so on; or none"
    )
    uncertainty: UncertaintyTable | None = None

    @property
    def states(self) -> int:
        """Number of states."""
        return 0 if self.modes is None else self.modes.states

    def shape_of(self, matrix: str) -> tuple[Count, Count]:
        """Rows and columns that a matrix has: how many, and of what."""
        counts = {
            "states": self.states,
            "actuators": len(self.actuators),
            "outputs": len(self.outputs),
            "elements": len(self.hysteresis),
        }
        rows, columns = _SIDES[matrix]
        return (counts[rows], rows), (counts[columns], columns)

    def problems(self) -> Iterator[Problem]:
        """Channels that are counted, matrices that fit them, elements that act and do not run away, known names."""
        faults = list(self._count_problems())
        yield from faults
        yield from _place_problems(self.outputs)
        if faults:
            return
        faults = list(self._matrix_problems())
        yield from faults
        if faults:
            return
        if self.uncertainty is not None:
            yield from _name_problems(self, self.uncertainty)
        faults = list(self._element_problems())
        yield from faults or self._growth_problems()

    def _count_problems(self) -> Iterator[Problem]:
        for key, least in (("actuators", 1), ("outputs", 1), ("hysteresis", 0)):
            tables = getattr(self, key)
            wanted = [str(number) for number in range(1, len(tables) + 1)]
            if len(tables) < least:
                yield Problem(key, "is empty", f"a table [{key}.1]")
            elif sorted(tables) != sorted(wanted):
                odd = next(name for name in tables if name not in wanted)
                reason = f'has "{odd[:40]}" where its {len(tables)} tables are counted from 1'
                yield Problem(key, reason, ", ".join(f"[{key}.{number}]" for number in wanted[:3]))
            names = [table.name for table in in_order(tables)] if key != "hysteresis" else []
            if twice := next((name for name in names if names.count(name) > 1), ""):
                yield Problem(key, f'has two tables of the name "{twice[:40]}"', "a name of its own for each")

    def _matrix_problems(self) -> Iterator[Problem]:
        for name in MATRICES:
            given, (rows, columns) = getattr(self.matrices, name), self.shape_of(name)
            if given is None:
                continue
            if missing := next((_TABLE_OF[noun] for count, noun in (rows, columns) if not count), ""):
                yield Problem(f"matrices.{name}", f"stands without a table {missing}", "it, or this line removed")
                continue
            yield from (p._replace(key=f"matrices.{p.key}") for p in shape_problems(name, given, rows, columns))
        if self.modes is not None and self.matrices.C is None:
            reason = f"has no C, so none of the {self.states} states is seen in an output"
            yield Problem("matrices", reason, "C, with a row for each output, or the table [modes] removed")

    def _element_problems(self) -> Iterator[Problem]:
        matrices = self.matrices
        for place, table in enumerate(in_order(self.hysteresis)):
            key = f"hysteresis.{place + 1}"
            acts = any(row[place] for name in "EK" for row in getattr(matrices, name) or ())
            fed = any(matrices.F[place]) if matrices.F is not None else False
            driven = fed or (any(matrices.G[place]) if matrices.G is not None else False)
            if not acts:
                reason = f"acts on nothing: column {place + 1} of E and of K is zero"
                yield Problem(key, reason, "a number other than 0 there, or this element removed from all matrices")
            if not driven:
                reason = f"is driven by nothing: row {place + 1} of F and of G is zero"
                yield Problem(key, reason, "a number other than 0 there, or this element removed from all matrices")
            if fed and table.depends_on_rate:
                rate = next(key for key, field in _RATE if getattr(table, field))
                reason = f"makes an element depend on the rate that row {place + 1} of F feeds back"
                yield Problem(f"{key}.{rate}", reason, "this line removed, or a row of zeros in F")

    def _growth_problems(self) -> Iterator[Problem]:
        """Hysteretic stiffness that runs away: modes that grow with the elements at their slope for large drives."""
        import numpy as np

        from microrad.core import lti

        if self.modes is None or self.matrices.E is None or self.matrices.F is None:
            return
        A, E, F = lti.modal_matrix(self.modes.roots), np.array(self.matrices.E), np.array(self.matrices.F)
        tables = in_order(self.hysteresis)
        gains = np.array([(table.d1 or 0.0) + table.linear_gain for table in tables])
        plays = [place for place, table in enumerate(tables) if table.model == "plays"]
        sums = np.array([np.sum(table.weights or 0.0) - table.linear_gain for table in tables])[plays]
        growth = lti.growth_1_s(A + (E * gains) @ F, E[:, plays], F[plays], sums)
        if growth >= 0.0:
            reason = (
                f"makes the mirror run away: where its elements slide it grows by {growth:.3g} 1/s, whatever the drive"
            )
            yield Problem("hysteresis", reason, "smaller weights, or smaller numbers in E or F")


_TABLE_OF = {"states": "[modes]", "elements": "[hysteresis.1]"}
_SIDES = {
    "B": ("states", "actuators"),
    "C": ("outputs", "states"),
    "D": ("outputs", "actuators"),
    "E": ("states", "elements"),
    "F": ("elements", "states"),
    "G": ("elements", "actuators"),
    "K": ("outputs", "elements"),
}
_RATE = (("widening", "widening_s"), ("d2", "d2_s_v"), ("delta", "delta_s_v"))


def in_order(tables: Mapping[str, Any]) -> tuple[Any, ...]:
    """Tables that are counted from 1, in the order of their numbers."""
    return tuple(tables[name] for name in sorted(tables, key=lambda name: (len(name), name)))


def _place_problems(outputs: Mapping[str, OutputTable]) -> Iterator[Problem]:
    """Places of displacements from which two tilts and a piston do not follow."""
    displacements = {name: table for name, table in outputs.items() if table.quantity == "displacement"}
    places = [table.position_m for table in displacements.values() if table.position_m is not None]
    if not places:
        return
    for name, table in displacements.items():
        if table.position_m is None:
            advice = "a position of each displacement, or of none"
            yield Problem(f"outputs.{name}.position", "is missing, while other displacements have one", advice)
    if len(places) < len(displacements):
        return
    advice = "three displacements with a position, not on one line, or no position"
    if len(places) < 3:
        reason = f"has {len(places)} displacements with a position, too few for two tilts and a piston"
        yield Problem("outputs", reason, advice)
    elif on_a_line(places):
        yield Problem("outputs", "has all displacements on one line, so a tilt about that line moves none", advice)


def on_a_line(places: Sequence[tuple[float, ...]]) -> bool:
    """Whether places (x, y) lie on one line, or so close to one that a tilt about it is not to be seen."""
    import numpy as np

    at = np.array(places)
    along, across = np.linalg.svd(at - at.mean(axis=0), compute_uv=False)
    return bool(across <= _ON_A_LINE * along)


# ---------------------------------------------------------------------------------------------------------- parameters
_MOST_TOLD = 20  # names of parameters that do not fit
_KNOWN_OF_ELEMENTS = (
    *("thresholds", "weights", "widening", "polynomial"),
    *("d1", "d2", "epsilon", "delta", "alpha", "beta", "gamma", "eta", "exponent"),
)


def parameters(mirror: CoupledMirror) -> dict[str, float]:
    """Every number of a mirror that an identification may find, by its key, in SI units; a zero frequency is none."""
    found = {"recording.delay": mirror.recording.delay_s}
    if mirror.modes is not None:
        found |= {f"modes.decay.{i}": decay for i, decay in enumerate(mirror.modes.decay_1_s, 1)}
        found |= {f"modes.frequency.{i}": w for i, w in enumerate(mirror.modes.frequency_rad_s, 1) if w}
    for name in MATRICES:
        rows = getattr(mirror.matrices, name) or ()
        found |= {f"matrices.{name}.{i}.{j}": v for i, row in enumerate(rows, 1) for j, v in enumerate(row, 1)}
    for number, table in mirror.hysteresis.items():
        fields = {info.alias or field: getattr(table, field) for field, info in type(table).model_fields.items()}
        for key in _KNOWN_OF_ELEMENTS:
            value = fields[key]
            if isinstance(value, tuple):
                found |= {f"hysteresis.{number}.{key}.{i}": v for i, v in enumerate(value, 1)}
            elif value is not None:
                found[f"hysteresis.{number}.{key}"] = value
    return found


def _name_problems(mirror: CoupledMirror, uncertainty: UncertaintyTable) -> Iterator[Problem]:
    """Parameters that this mirror does not have, and those named twice."""
    there, key = parameters(mirror), "uncertainty.parameters"
    unknown = [name for name in uncertainty.parameters if name not in there]
    for name in unknown[:_MOST_TOLD]:
        near = (*difflib.get_close_matches(name[:60], there, n=1), "modes.decay.1")[0]
        yield Problem(key, f'has "{name[:60]}", which is no parameter of this mirror', f'such as "{near}"')
    twice = [name for name, count in Counter(uncertainty.parameters).items() if count > 1]
    for name in twice[:_MOST_TOLD]:
        yield Problem(key, f'has "{name[:60]}" more than once', "each parameter once")
