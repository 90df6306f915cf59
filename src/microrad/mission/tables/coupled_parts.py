"""Parts of a mirror file of version 2: channels, recordings, modes, matrices, hysteresis elements, uncertainty."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any, Literal

from pydantic import Field, GetJsonSchemaHandler
from pydantic_core import CoreSchema

from microrad.core.units import counted, format_input, format_limit
from microrad.mission.fields import Problem, ProblemsError, Quantity, Several, Table, Whole
from microrad.mission.tables.mirror import INDEFINITE, Frequency, KeyList, Name, Rate, Voltage, least_alpha_1_v

if TYPE_CHECKING:
    from microrad.core.arrays import Floats

Rows = tuple[tuple[float, ...], ...]

Count = tuple[int, str]  # how many there are of what the rows or columns of a matrix belong to, and what that is
_MANY = 20_000  # items of a list for each parameter, or pair of them
_MOST_TOLD = 20  # faults of one matrix
_MOST_MODES = 100
_LENGTH = 1e-6  # a row of a factor may differ from length 1 by so much: six digits leave it


@dataclass(frozen=True, slots=True)
class _Matrix(Several):
    """A list of rows, each a list of plain numbers."""

    def read(self, value: object) -> Any:
        """The rows; raises `ProblemsError` with every item that does not fit."""
        if not isinstance(value, list | tuple) or not value or not all(isinstance(r, list | tuple) for r in value):
            raise ProblemsError(Problem("", "is no list of rows", f"{self.wanted}: {self.example}"))
        if len(value) > _MANY:
            raise ProblemsError(Problem("", f"has {len(value)} rows", f"at most {_MANY} rows"))
        rows: list[tuple[float, ...]] = []
        problems: list[Problem] = []
        for place, row in enumerate(value, 1):
            try:
                rows.append(Several.read(self, row))
            except ProblemsError as error:
                problems += [Problem("", f"row {place}: {p.reason}", p.expected) for p in error.problems]
            if len(problems) >= _MOST_TOLD:
                break
        if problems:
            raise ProblemsError(*problems)
        return tuple(rows)

    @property
    def wanted(self) -> str:
        """What the key expects, in words."""
        return "a list of rows, each a list of numbers without quotes"

    @property
    def example(self) -> str:
        """Two rows."""
        return "[[1.0, 0.0], [0.0, 1.0]]"

    def __get_pydantic_json_schema__(self, schema: CoreSchema, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        """An array of arrays of numbers."""
        row = Several.__get_pydantic_json_schema__(self, schema, handler)
        return {"type": "array", "minItems": 1, "items": row}


Matrix = Annotated[Rows, _Matrix(Quantity(""))]
Number = Annotated[float, Quantity("")]
PerVolt = Annotated[float, Quantity("1/V")]


# ------------------------------------------------------------------------------------------------------------ channels
class ActuatorTable(Table):
    """One drive: where it rests, and the range and the rate that the model was identified for."""

    name: Name = Field(description="what the report calls the actuator")
    bias_v: Voltage = Field(description="drive about which the mirror works")
    drive_min_v: Voltage = Field(description="lowest drive that the model was identified for")
    drive_max_v: Voltage = Field(description="highest drive that the model was identified for")
    rate_limit_v_s: Rate = Field(description="fastest drive that the model was identified for")

    def problems(self) -> Iterator[Problem]:
        """A range that goes up, and the bias within it."""
        low, high = format_input(self.drive_min_v, "V"), format_input(self.drive_max_v, "V")
        if not self.drive_min_v < self.drive_max_v:
            yield Problem("drive_max", f"is not above drive_min ({low})", f"a voltage above {low}")
        elif not self.drive_min_v <= self.bias_v <= self.drive_max_v:
            yield Problem("bias", f"is outside drive_min to drive_max ({low} to {high})", f"{low} to {high}")


class OutputTable(Table):
    """One sensor."""

    name: Name = Field(description="what the report calls the output")
    quantity: Literal["displacement", "angle"] = Field(description="m along z, or rad")
    position_m: Annotated[tuple[float, ...], Several(Quantity("m", "mm"))] | None = Field(
        default=None, description="where a displacement is measured: x and y in the plane of the mirror; or left out"
    )

    def problems(self) -> Iterator[Problem]:
        """A place with two coordinates, of a displacement."""
        if self.position_m is None:
            return
        if self.quantity == "angle":
            yield Problem(
                "position", "stands with an angle, which is alike everywhere on a mirror", "this line removed"
            )
        if len(self.position_m) != 2:
            counts = f"has {len(self.position_m)} coordinates"
            yield Problem("position", counts, 'x and y in the plane of the mirror: position = ["30 mm", "0 mm"]')


class RecordingTable(Table):
    """What belongs to the recordings that the model was identified from, and not to the mirror."""

    delay_s: Annotated[float, Quantity("s", "us")] = Field(
        description="of converters, filters and amplifier; the model takes the drive of that long ago"
    )
    rate_hz: Frequency = Field(description="samples a second")
    steps_per_sample: Annotated[int, Whole("", least=1, most=1000)] = Field(
        description="steps of the plant that the model was fitted with"
    )
    excited_from_hz: Frequency = Field(description="lowest frequency with a drive in it")
    excited_to_hz: Frequency = Field(description="highest frequency with a drive in it")

    def problems(self) -> Iterator[Problem]:
        """A band that goes up, to half the rate at most."""
        if not self.excited_from_hz < self.excited_to_hz:
            yield Problem("excited_to", "is not above excited_from", "a band that goes up")
        if self.excited_to_hz > self.rate_hz / 2.0:
            half = format_limit(self.rate_hz / 2.0, "Hz")
            yield Problem("excited_to", f"is above half the rate ({half})", f"at most {half}")


# --------------------------------------------------------------------------------------------------------------- parts
class ModesTable(Table):
    """The modes: exp(-decay t) times a turn at the frequency, or without one for a real mode, of frequency 0.

    A mode with a frequency has two states, with the block [[-decay, -frequency], [frequency, -decay]] in A; a real one
    has one.
    """

    decay_1_s: Annotated[tuple[float, ...], Several(Quantity("1/s"), most=_MOST_MODES)] = Field(
        description="of each mode, above 0"
    )
    frequency_rad_s: Annotated[tuple[float, ...], Several(Quantity("rad/s"), most=_MOST_MODES)] = Field(
        description="of each mode; 0 for a real one"
    )

    def problems(self) -> Iterator[Problem]:
        """A frequency for each decay, and no mode that grows."""
        for place, decay in enumerate(self.decay_1_s, 1):
            if not decay > 0.0:
                yield Problem(
                    "decay", f"item {place} is {decay:g} 1/s: an unstable mode, which does not die out", "above 0 1/s"
                )
        if len(self.frequency_rad_s) != len(self.decay_1_s):
            counts = f"has {counted(len(self.frequency_rad_s), 'item')} where decay has {len(self.decay_1_s)}"
            yield Problem("frequency", counts, 'one for each mode, "0 rad/s" for a real one')

    @property
    def roots(self) -> tuple[tuple[float, float], ...]:
        """Real and imaginary part of each mode, as `lti.modal_matrix` takes them."""
        return tuple((-decay, w) for decay, w in zip(self.decay_1_s, self.frequency_rad_s, strict=True))

    @property
    def states(self) -> int:
        """Number of states: two for each mode with a frequency, one for the others."""
        return sum(2 if w else 1 for w in self.frequency_rad_s)


class MatricesTable(Table):
    """The matrices of the plant form but for A; one that is left out is zero."""

    B: Matrix | None = Field(default=None, description="from the drives to the states: rows states, columns actuators")
    C: Matrix | None = Field(default=None, description="from the states to the outputs: rows outputs, columns states")
    D: Matrix | None = Field(
        default=None, description="from the drives to the outputs: rows outputs, columns actuators"
    )
    E: Matrix | None = Field(default=None, description="from the elements to the states: rows states, columns elements")
    F: Matrix | None = Field(
        default=None, description="drive of the elements by the states: rows elements, columns states"
    )
    G: Matrix | None = Field(
        default=None, description="drive of the elements by the drives: rows elements, columns actuators"
    )
    K: Matrix | None = Field(
        default=None, description="from the elements to the outputs: rows outputs, columns elements"
    )


_PLAYS, _BOUC_WEN = 'model = "plays"', 'model = "bouc-wen"'


class HysteresisTable(Table):
    """One hysteresis element: play operators, or a Bouc-Wen model; its drive q counts in volts, its output is a number.

    See `microrad.mirror.hysteresis` for both models.
    """

    model: Literal["plays", "bouc-wen"] = Field(
        description="which hysteresis the element has, and so which of the other keys"
    )
    thresholds_v: Annotated[tuple[float, ...], Several(Quantity("V", least=0.0), rising=True)] | None = Field(
        default=None, description="half widths of the plays"
    )
    weights: Annotated[tuple[float, ...], Several(Quantity(""))] | None = Field(
        default=None, description="of the plays, of either sign"
    )
    widening_s: Annotated[float, Quantity("s", "us", least=0.0)] | None = Field(
        default=None, description="growth of the thresholds above 0 with the rate of q; or none"
    )
    polynomial: Annotated[tuple[float, ...], Several(Quantity(""), most=3)] | None = Field(
        default=None, description="c1, c2 and c3 of c1 s^2 + c2 |s| s + c3 s^3 beside the plays, with s = q / reach"
    )
    reach_v: Annotated[float, Quantity("V", above=0.0)] | None = Field(
        default=None, description="q where s is 1; beyond it the polynomial is held"
    )
    d1: Number | None = Field(default=None, description="gain without hysteresis")
    d2_s_v: Annotated[float, Quantity("s/V")] | None = Field(default=None, description="change of d1 with the rate")
    epsilon: Number | None = Field(default=None, description="slope of h behind a reversal")
    delta_s_v: Annotated[float, Quantity("s/V")] | None = Field(
        default=None, description="growth of epsilon with the rate"
    )
    alpha_1_v: PerVolt | None = Field(default=None, description="decay of h")
    beta_1_v: PerVolt | None = Field(default=None, description="share of the decay that turns with the direction")
    gamma_1_v: PerVolt | None = Field(default=None, description="tells the signs of h apart; or left out")
    eta_1_v: PerVolt | None = Field(default=None, description="tells rising from falling q; or left out")
    exponent: Annotated[float, Quantity("", least=1.0, most=100.0)] | None = Field(
        default=None, description="of h in its decay; left out, 1"
    )
    bias_v: Voltage | None = Field(default=None, description="q at rest, where d2 acts; left out, 0")
    rate_limit_v_s: Rate | None = Field(default=None, description="rate of q beyond which rate terms are held")

    def problems(self) -> Iterator[Problem]:
        """The keys of one model, plays with a weight each, a Bouc-Wen model that stays bounded."""
        plays = self.model == "plays"
        needed = {"thresholds": '["0 V", "1 V"]', "weights": "[0.8, 0.1]"}
        of_bouc_wen = {"d1": "0.8", "epsilon": "-0.2", "alpha": '"2 1/V"', "beta": '"0.5 1/V"'}
        more = ("d2", "delta", "gamma", "eta", "exponent", "bias", "rate_limit")
        own, other = (_PLAYS, _BOUC_WEN) if plays else (_BOUC_WEN, _PLAYS)
        allowed = ("widening", "rate_limit", "polynomial", "reach") if plays else more
        yield from self.choice_problems(own, needed if plays else of_bouc_wen, allowed, lambda key: other)
        if self.depends_on_rate and self.rate_limit_v_s is None:
            yield Problem("rate_limit", "is missing, and the element depends on the rate", 'rate_limit = "1 kV/s"')
        yield from self._play_problems() if plays else self._bouc_wen_problems()

    @property
    def depends_on_rate(self) -> bool:
        """Whether the output depends on how fast the drive passes."""
        return bool(self.widening_s or self.d2_s_v or self.delta_s_v)

    @property
    def linear_gain(self) -> float:
        """Weight of the play whose threshold is 0, which never sticks."""
        pairs = zip(self.thresholds_v or (), self.weights or (), strict=False)
        return sum(weight for threshold, weight in pairs if threshold == 0.0)

    def _play_problems(self) -> Iterator[Problem]:
        if self.thresholds_v is None or self.weights is None:
            return
        if len(self.weights) != len(self.thresholds_v):
            counts = f"has {counted(len(self.weights), 'item')} where thresholds has {len(self.thresholds_v)}"
            yield Problem("weights", counts, "one weight for each threshold")
        if not any((*self.weights, *(self.polynomial or ()))):
            advice = "a weight other than 0, or a polynomial beside them"
            yield Problem("weights", "is zero throughout, so the element acts on nothing", advice)
        if self.polynomial is not None and len(self.polynomial) != 3:
            counts = f"has {counted(len(self.polynomial), 'item')}"
            yield Problem("polynomial", counts, "three: of s^2, of |s| s and of s^3, such as [0.0, 0.01, -0.02]")
        if (self.polynomial is None) != (self.reach_v is None):
            there, missing = ("polynomial", "reach") if self.reach_v is None else ("reach", "polynomial")
            example = {"reach": 'reach = "2 V"', "polynomial": "polynomial = [0.0, 0.01, -0.02]"}[missing]
            yield Problem(missing, f"is missing beside {there}", example)

    def _bouc_wen_problems(self) -> Iterator[Problem]:
        if self.alpha_1_v is None or self.beta_1_v is None:
            return
        least = least_alpha_1_v(self.beta_1_v, self.gamma_1_v or 0.0, self.eta_1_v or 0.0)
        if not self.alpha_1_v > least:
            size = format_limit(least, "1/V", least=True)
            reason = f"is not above what beta, gamma and eta take off it ({size}), so h would grow without bound"
            yield Problem("alpha", reason, f"above {size}")
        if self.d1 == self.epsilon == 0.0:
            yield Problem(
                "d1", "is 0 beside an epsilon of 0, so the element acts on nothing", "one of them other than 0"
            )


def shape_problems(key: str, given: Rows, rows: Count, columns: Count) -> Iterator[Problem]:
    """Rows and columns of a matrix that are not as many as there are of what they belong to."""
    if len(given) != rows[0]:
        yield Problem(key, f"has {len(given)} rows where there are {rows[0]} {rows[1]}", "one row for each, in order")
    wrong = [place for place, row in enumerate(given, 1) if len(row) != columns[0]]
    if wrong:
        counts = f"row {wrong[0]} has {len(given[wrong[0] - 1])} numbers where there are {columns[0]} {columns[1]}"
        more = f"; {len(wrong) - 1} other rows do not fit, either" if wrong[1:] else ""
        yield Problem(key, counts + more, f"{columns[0]} numbers in each row")


# --------------------------------------------------------------------------------------------------------- uncertainty
class UncertaintyTable(Table):
    """How well parameters are known: standard errors in SI units, and their correlation.

    The correlation is that of the values, by its lower triangle without the diagonal, row by row, or by a factor with a
    row of length 1 for each parameter: factor times its transpose.
    """

    parameters: Annotated[
        tuple[str, ...], KeyList(Quantity(""), most=_MANY, shown='["modes.decay.1", "matrices.B.2.1"]')
    ] = Field(description="keys inside the mirror, items, rows and columns counted from 1")
    standard_errors: Annotated[tuple[float, ...], Several(Quantity("", least=0.0), most=_MANY)] = Field(
        description="absolute, in the SI units of the values"
    )
    factor: Matrix | None = Field(default=None, description="root of the correlation, a row of length 1 a parameter")
    correlation: Annotated[tuple[float, ...], Several(Quantity("", least=-1.0, most=1.0), most=_MANY)] | None = Field(
        default=None, description="lower triangle without the diagonal, row by row; without both, there is none"
    )

    def problems(self) -> Iterator[Problem]:
        """Counts that fit, and a correlation that is one."""
        count = len(self.parameters)
        if len(self.standard_errors) != count:
            found = f"has {counted(len(self.standard_errors), 'item')} where parameters has {count}"
            yield Problem("standard_errors", found, "one standard error for each parameter")
        if self.factor is not None and self.correlation is not None:
            yield Problem("correlation", "stands beside factor", "one of the two removed")
        if self.factor is not None:
            yield from self._factor_problems(self.factor, count)
        if self.correlation is not None:
            yield from self._correlation_problems(self.correlation, count)

    def _factor_problems(self, factor: Rows, count: int) -> Iterator[Problem]:
        yield from shape_problems("factor", factor, (count, "parameters"), (len(factor[0]), "numbers in row 1"))
        squares = [sum(value * value for value in row) for row in factor]
        wrong = [place for place, square in enumerate(squares) if not abs(square - 1.0) <= 2.0 * _LENGTH]
        if wrong:
            first = f"row {wrong[0] + 1} has the length {squares[wrong[0]] ** 0.5:.7g}"
            more = f"; {len(wrong)} of {len(factor)} rows have another length than 1" if wrong[1:] else ""
            yield Problem("factor", f"{first}, so the correlation with itself is not 1{more}", "rows of length 1")

    def _correlation_problems(self, correlation: tuple[float, ...], count: int) -> Iterator[Problem]:
        import numpy as np

        pairs = count * (count - 1) // 2
        if len(correlation) != pairs:
            found = f"has {counted(len(correlation), 'item')} where {count} parameters have {pairs} pairs"
            yield Problem("correlation", found, f"{pairs} numbers, the lower triangle without the diagonal, or none")
        elif (least := float(np.linalg.eigvalsh(self.correlation_matrix)[0])) < -INDEFINITE:
            found = f"is not positive semidefinite: its smallest eigenvalue is {least:.3g}"
            yield Problem("correlation", found, "correlations that can be together, as the fit gave them")

    @property
    def correlation_matrix(self) -> "Floats":
        """The whole correlation matrix, of a `correlation`."""
        import numpy as np

        count = len(self.parameters)
        whole = np.eye(count)
        below = np.tril_indices(count, -1)
        whole[below] = self.correlation or 0.0
        whole.T[below] = whole[below]
        return whole
