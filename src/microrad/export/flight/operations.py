"""What a step of exported code costs: operations counted from the sizes of its tables, the worst branch taken.

The counts follow templates/controller.c.j2, forward.c.j2, hysteresis.h.j2 and fixed.c.j2 line by line, as they are
written: a processor without a floating-point unit calls a routine for each of these operations. Changes of sign and
absolute values count nothing: they set a bit. Calls of exp, expm1, log1p, pow and floor count as one each, whatever
they cost inside.
"""

from collections.abc import Iterable
from dataclasses import astuple, dataclass, fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from microrad.core import kernels
from microrad.export.flight.fixed_form import FixedForm
from microrad.export.linear_part.sections import Sections, compensated_states
from microrad.export.records import AdaptiveLaw, FlightController, InverseLaw
from microrad.export.templating import Precision

MOST_TRIALS = 256
"""Most trial steps of a Bouc-Wen element with an exponent other than 1, as in templates/hysteresis.h.j2."""


@dataclass(frozen=True, slots=True)
class Operations:
    """Floating-point operations. Subtractions are additions, exponentials exp and expm1, roundings floor.

    Kinds are counted each by itself: where one branch has more products and another more exponentials, both count.
    """

    multiplications: int = 0
    additions: int = 0
    divisions: int = 0
    comparisons: int = 0
    exponentials: int = 0
    logarithms: int = 0
    powers: int = 0
    roundings: int = 0

    def __add__(self, other: "Operations") -> "Operations":
        """One behind the other."""
        return Operations(*(a + b for a, b in zip(astuple(self), astuple(other), strict=True)))

    def __mul__(self, times: int) -> "Operations":
        """So many times."""
        return Operations(*(a * times for a in astuple(self)))

    def __or__(self, other: "Operations") -> "Operations":
        """The worse of two branches, kind by kind."""
        return Operations(*(max(a, b) for a, b in zip(astuple(self), astuple(other), strict=True)))

    @property
    def words(self) -> str:
        """The counts in a line, without those that are 0."""
        return _counts(self, (each.name for each in fields(self)))


def operations(of: FlightController, form: Sections, precision: Precision) -> Operations:
    """The most that one call of {name}_step costs in floating point, whatever it reads.

    Args:
        of: The controller.
        form: Its linear part.
        precision: Precision of the code.
    """
    found = _mended(of, form, precision)  # whether the state is sound, then whether the readings are accepted
    found += Operations(comparisons=2) * sum(each.size for each in of.inputs)
    found += _product(form.C) + _product(form.D)
    if of.inverse is not None:
        found += _inverse(_frozen_part(of), of.actuators, precision)
    if of.adaptation is not None:
        found += _learning(of.adaptation, of.actuators)
    if of.forward is not None:
        found += _forward(of.forward)
    found += _command(of.resolution_v > 0.0) * of.actuators
    return found + _states(form, precision) if form.order else found


@dataclass(frozen=True, slots=True)
class FixedOperations:
    """Operations of a step in fixed point: products of two numbers of 32 bits into 64, and the rest on 64 bits.

    ``single`` are those of the inverse or the feedforward, in single precision, with ``conversions`` between whole and
    real numbers.
    """

    multiplications: int
    additions: int
    shifts: int
    comparisons: int
    conversions: int = 0
    single: Operations = Operations()

    @property
    def words(self) -> str:
        """The counts in a line, without those that are 0."""
        whole = ("multiplications", "additions", "shifts", "comparisons")
        found = f"{_counts(self, whole)} of whole numbers"
        if self.single == Operations():
            return found
        return f"{found}; {_counts(self, ('conversions',))}; in single precision {self.single.words}"


def _counts(of: Operations | FixedOperations, names: Iterable[str]) -> str:
    counts = [(name, int(getattr(of, name))) for name in names]
    return ", ".join(f"{n} {name if n > 1 else name[:-1]}" for name, n in counts if n) or "no operations"


def fixed_operations(of: FlightController, fixed: FixedForm) -> FixedOperations:
    """The most that one call of {name}_fixed_step costs, whatever it reads; loops and counters not counted.

    Args:
        of: The controller, for its actuators and its inverse.
        fixed: Its linear part in fixed point.
    """
    states, actuators, outputs = len(fixed.state_scale), of.actuators, len(fixed.output_scale)
    m, A, C = len(fixed.input_scale), fixed.state.value[:, :states], fixed.output.value[:, :states]
    terms = int(np.count_nonzero(fixed.state.value) + np.count_nonzero(fixed.output.value))
    reads = int(np.any(A)) + int(np.any(C))  # the states are rounded for each of the two products
    shifts = [*(fixed.state_shift * reads), *fixed.output_shift, *(each.shift for each in fixed.converter)]
    up = sum(shift > 0 for shift in shifts)
    held, clipped = m + outputs + states * (1 + reads), 5 + (2 if fixed.converter else 0)
    windup = 2 * actuators if np.any(fixed.state.value[:, states + m :]) else 0
    added = 0 if of.inverse is None and of.forward is None else actuators
    return FixedOperations(
        multiplications=terms + len(fixed.converter),
        additions=terms + up + states + actuators + added,
        shifts=up + len(shifts) + states * (1 + reads),
        comparisons=len(shifts) + 3 * held + clipped * actuators + windup,
        **(_single(of, outputs - actuators) if added else {}),
    )


# -------------------------------------------------------------------------------------------------------- linear part
_SOUND = Operations(comparisons=2)
_CLAMP = Operations(comparisons=2)
_COMPENSATED = _SOUND + Operations(additions=4)


def _mended(of: FlightController, form: Sections, precision: Precision) -> Operations:
    """Whether each number of the state is sound: states, what rounding left out, readings, commands, hysteresis."""
    numbers = form.order + sum(each.size for each in of.inputs) + of.actuators
    if precision == "single" and any(compensated_states(form)):
        numbers += form.order
    if of.forward is not None:
        numbers += _kept_forward(of.forward)
    return _SOUND * (numbers if of.inverse is None else numbers + _kept(_frozen_part(of), of.actuators, precision))


def _frozen_part(of: FlightController) -> InverseLaw:
    """The inverse without what learns in its place: direct gain and plays."""
    assert of.inverse is not None
    if of.adaptation is None:
        return of.inverse
    none = {name: getattr(of.inverse, name)[:0] for name in ("play_threshold", "play_weight", "play_actuator")}
    return replace(of.inverse, direct=np.zeros_like(of.inverse.direct), **none)


def _kept(of: InverseLaw, actuators: int, precision: Precision) -> int:
    """Numbers that an inverse keeps: targets, hysteresis of the elements, plays, lags."""
    lags = of.lag_keep.size * (2 if precision == "single" else 1)
    return int(actuators + of.bouc_wen.shape[0] + of.play_threshold.size + lags)


def _kept_forward(of: kernels.ForwardBank) -> int:
    """Numbers that a feedforward keeps: drives of its elements, hysteresis, plays."""
    return int(of.drives.shape[1] + len(of.bouc_wen) + of.play_threshold.size)


def _product(matrix: NDArray[np.float64]) -> Operations:
    """Of a matrix by a vector, added to another: the numbers that are not 0 are multiplied and added."""
    return Operations(multiplications=1, additions=1) * int(np.count_nonzero(matrix))


def _states(form: Sections, precision: Precision) -> Operations:
    compensated = np.array(compensated_states(form) if precision == "single" else [False] * form.order)
    moves = form.A - np.diag(compensated.astype(float))
    found = _product(moves) + _product(form.B) + _product(form.L)
    slow = int(np.count_nonzero(compensated))
    return found + _COMPENSATED * slow + _SOUND * (form.order - slow)


def _command(converter: bool) -> Operations:
    """Clip, whether v is finite and was clipped, what the limits took off; rounding to the converter's values."""
    found = _CLAMP + Operations(comparisons=3, additions=1)
    return found + _CLAMP + Operations(1, 1, 1, roundings=1) if converter else found


# -------------------------------------------------------------------------------------------------------- feedforward
def _forward(of: kernels.ForwardBank) -> Operations:
    """add_forward of templates/forward.c.j2."""
    elements, operators, plays = int(of.drives.shape[1]), len(of.operator), int(of.play_threshold.size)
    widens = bool(np.any(of.operator[:, kernels.WIDENING]))
    bends = bool(np.any(np.isfinite(of.operator[:, kernels.REACH])))
    found = _SOUND * elements + _product(of.drives)
    if len(of.bouc_wen) and operators:
        found += Operations(comparisons=1) * elements
    found += Operations(additions=1) * (len(of.bouc_wen) + (operators if widens else 0))
    for row in of.bouc_wen:
        found += _run_element(power=float(row[kernels.POWER]) != 0.0)
    if widens:
        found += (_CLAMP + Operations(divisions=1, comparisons=2)) * operators
        found += Operations(comparisons=1) * plays
        found += Operations(multiplications=1, additions=1) * int(np.sum(of.play_threshold > 0.0))
    found += (_CLAMP + Operations(multiplications=1, additions=3)) * plays
    if bends:
        found += (_CLAMP + Operations(multiplications=5, additions=3, divisions=1)) * operators
    return found


def _run_element(power: bool) -> Operations:
    """A Bouc-Wen element that is run forward: rate, h, and d1 exp(-d2 rate) (q + bias) - d1 bias + h."""
    rate = _CLAMP + Operations(divisions=1, comparisons=1)
    output = Operations(multiplications=4, additions=3, exponentials=1)
    return rate + _ADVANCE + (_power_step() if power else _linear_step()) + output


# ------------------------------------------------------------------------------------------------------------ inverse
def _inverse(of: InverseLaw, actuators: int, precision: Precision) -> Operations:
    elements, plays, lags = of.bouc_wen.shape[0], of.play_threshold.size, of.lag_keep.size
    widens = of.widening[:, 0] != 0.0
    widening = bool(np.any(widens)) and plays > 0
    found = (_SOUND + Operations(additions=1)) * actuators  # targets; the sum of v and drive
    found += Operations(multiplications=1, additions=1) * lags  # what creep adds is taken off
    if (widening or elements > 0) and of.by_difference:
        found += Operations(additions=1, divisions=1) * actuators
    if np.any(of.direct):
        found += Operations(multiplications=1) * actuators
    if widening:
        found += (_CLAMP + Operations(multiplications=1, comparisons=1)) * actuators
        found += Operations(comparisons=1) * int(np.count_nonzero(widens))
        found += Operations(comparisons=1) * plays + Operations(additions=1) * int(np.sum(of.play_threshold > 0.0))
    for row in of.bouc_wen:
        found += _element(power=float(row[kernels.POWER]) != 0.0)
    found += (_CLAMP + Operations(multiplications=1, additions=3)) * plays
    lag = _COMPENSATED if precision == "single" else _SOUND + Operations(additions=1)
    return found + (Operations(multiplications=1, additions=1) + lag) * lags


def _learning(of: AdaptiveLaw, actuators: int) -> Operations:
    """An adaptive inverse: offset and plays of each sample, and the worst phase; actuators are a sample apart."""
    offset = _CLAMP + Operations(multiplications=2, additions=7, comparisons=1)
    play = _CLAMP + Operations(multiplications=1, additions=4)
    cycle, delay = (int(of.settings[0, column]) for column in (kernels.CYCLE, kernels.DELAY))
    plays, worst = np.diff(of.start).tolist(), Operations()
    for begin in range(cycle):
        here = Operations()
        for a, n in enumerate(plays):
            here += _phase((begin + a) % cycle - delay, delay, n)
        worst |= here
    return offset * actuators + play * of.weight.size + worst


def _phase(behind: int, delay: int, plays: int) -> Operations:
    """What an actuator with so many plays does ``behind`` samples after the one in which it judges."""
    if behind == -delay:
        return Operations(additions=2) + Operations(multiplications=6, additions=10, comparisons=1) * plays
    if behind == 0:
        sums = Operations(multiplications=4, additions=12) * plays
        means = _CLAMP * 2 + Operations(multiplications=14, additions=21, divisions=1, comparisons=7)
        return _SOUND + sums + means
    if 0 < behind <= plays:
        return _CLAMP * 3 + Operations(multiplications=2, additions=6, divisions=1, comparisons=1)
    return Operations()


def _element(power: bool) -> Operations:
    """A Bouc-Wen element of the inverse: travel and rate, h, and Eq. 4; its share of the drive."""
    travel = _CLAMP + Operations(additions=1, divisions=2, comparisons=1)
    equation = Operations(multiplications=3, additions=4, divisions=1, exponentials=1)
    return travel + _ADVANCE + (_power_step() if power else _linear_step()) + equation


# {name}_bouc_wen_advance: the forcing, a decay for each sign of h, h at the end, and whether it is finite.
_ADVANCE = Operations(multiplications=7, additions=6, exponentials=1, comparisons=3)

_RELAXED = Operations(multiplications=2, additions=2, divisions=1, comparisons=1, exponentials=1)


def _linear_step() -> Operations:
    """{name}_linear_step. At h = 0 one comparison more tells the side, but then h crosses nothing."""
    end = _RELAXED + Operations(multiplications=1, comparisons=1)
    at_zero = Operations(comparisons=3) + end
    crossing = Operations(multiplications=1, comparisons=1)
    crossing += Operations(multiplications=1, divisions=2, comparisons=1, logarithms=1)
    crossing += Operations(multiplications=2, additions=1, comparisons=1) + _RELAXED
    return at_zero | (Operations(comparisons=2) + end + crossing)


_SLOPE = Operations(multiplications=3, additions=1, comparisons=1, powers=1)

_TRIAL = _SLOPE * 7 + Operations(multiplications=31, additions=25, divisions=3)


def _power_step() -> Operations:
    """{name}_power_step with as many trial steps as it may take."""
    begin = Operations(multiplications=3, additions=2, divisions=1, comparisons=2)
    taken = Operations(multiplications=1, additions=2, divisions=1, comparisons=3)
    change = Operations(multiplications=2, additions=1, comparisons=2, powers=1)
    return begin + (_TRIAL + taken + change) * MOST_TRIALS


# ------------------------------------------------------------------------- what fixed point has in single precision
def _single(of: FlightController, numbers: int) -> dict[str, Any]:
    """What works in single precision beside the linear part, and the way there and back.

    ``numbers`` are its inputs, targets and rates or drives of hysteresis; it gives a drive by actuator.
    """
    actuators = of.actuators
    there = Operations(multiplications=1) * numbers
    back = (_CLAMP + Operations(multiplications=1, additions=1, roundings=1)) * actuators
    step = (_SOUND + Operations(multiplications=1, additions=1)) * numbers
    if of.inverse is not None:
        frozen = _frozen_part(of)
        step += _inverse(frozen, actuators, "single") + _SOUND * _kept(frozen, actuators, "single")
    if of.adaptation is not None:
        step += _learning(of.adaptation, actuators)
    if of.forward is not None:
        step += _forward(of.forward) + _SOUND * _kept_forward(of.forward)
    step += _SOUND * (numbers + actuators)
    return {"conversions": numbers + actuators, "single": there + back + step + _command(converter=False) * actuators}
