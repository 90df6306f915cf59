"""The [mirror] table of a mission, which a mirror file holds by itself: linear part, hysteresis, creep, ranges."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Annotated, Any, Literal, NamedTuple

from pydantic import Field, GetJsonSchemaHandler
from pydantic_core import CoreSchema

from microrad.core.units import counted, format_input, format_limit
from microrad.mission.fields import Problem, ProblemsError, Quantity, Several, Table

ANGLE_MOST = math.pi / 2  # beyond a quarter turn no pointing error, beam or mirror angle has a meaning here
Name = Annotated[str, Field(min_length=1, max_length=200)]
Angle = Annotated[float, Quantity("rad", above=0.0, most=ANGLE_MOST)]
Frequency = Annotated[float, Quantity("Hz", above=0.0, most=1e12)]
DurationOrZero = Annotated[float, Quantity("s", "us", least=0.0)]
Voltage = Annotated[float, Quantity("V")]
Rate = Annotated[float, Quantity("V/s", "V/us", above=0.0)]
MirrorGain = Annotated[float, Quantity("rad/V", "mrad/V", above=0.0)]
Coefficients = Annotated[tuple[float, ...], Several(Quantity(""))]
Roots = Annotated[tuple[float, ...], Several(Quantity("Hz", above=0.0, most=1e12))]
Dampings = Annotated[tuple[float, ...], Several(Quantity("", least=-1.0, most=1.0))]

_STEEPEST = 1e150  # a coefficient over that of the highest power: 24 poles of 1e6 rad/s
INDEFINITE = 1e-2
"""How far below 0 the smallest eigenvalue of a correlation matrix may lie: two decimals leave so much."""


class LinearPart(Table):
    """Transfer function and the band it was identified in: in powers of s (rad/s), highest first, or by its roots.

    Roots are natural frequencies with a damping ratio each: below 1 a conjugate pair, at 1 (or -1) one real root; a
    positive damping lies in the left half plane. A pole may not have a negative one.
    """

    numerator: Coefficients | None = Field(
        default=None, description="of the transfer function in s, highest power first"
    )
    denominator: Coefficients | None = Field(
        default=None, description="of the transfer function in s, highest power first"
    )
    poles_hz: Roots | None = Field(default=None, description="natural frequencies, rising")
    pole_dampings: Dampings | None = Field(default=None, description="1 for a real pole")
    zeros_hz: Roots | None = Field(default=None, description="natural frequencies, rising; or none")
    zero_dampings: Dampings | None = Field(default=None, description="1 for a real zero, -1 in the right half plane")
    normalise_at_hz: Frequency = Field(description="where its magnitude is divided out")
    excited_from_hz: Frequency = Field(description="lowest frequency that it was identified at")
    excited_to_hz: Frequency = Field(description="highest frequency that it was identified at")

    def problems(self) -> Iterator[Problem]:
        """A proper fraction, normalised inside its band."""
        if self.poles_hz is None:
            yield from self._coefficient_problems()
        else:
            yield from self._root_problems()
        if not self.excited_from_hz < self.excited_to_hz:
            yield Problem("excited_to", "is not above excited_from", "a band that goes up")
        elif not self.excited_from_hz <= self.normalise_at_hz <= self.excited_to_hz:
            low, high = format_input(self.excited_from_hz, "Hz"), format_input(self.excited_to_hz, "Hz")
            yield Problem(
                "normalise_at", f"is outside excited_from to excited_to ({low} to {high})", f"{low} to {high}"
            )

    def _coefficient_problems(self) -> Iterator[Problem]:
        for key in ("zeros", "pole_dampings", "zero_dampings"):
            if getattr(self, "zeros_hz" if key == "zeros" else key) is not None:
                yield Problem(key, "stands without poles", 'the key poles, or this one removed: poles = ["5 kHz"]')
        if self.numerator is None or self.denominator is None:
            found = "neither poles nor numerator and denominator" if self.denominator is None else "no numerator"
            yield Problem("", f"has {found}", "poles and pole_dampings, or numerator and denominator")
            return
        zeros = [place for place, value in enumerate(self.numerator) if value != 0.0]
        if self.denominator[-1] == 0.0:
            advice = "a last coefficient other than 0; model drift apart from the mirror"
            yield Problem("denominator", "ends with 0, which makes the linear part an integrator", advice)
        largest = max(abs(each) for each in (*self.numerator, *self.denominator))
        if self.denominator[0] == 0.0:
            yield Problem("denominator", "begins with 0", "the highest power of s first, with a factor other than 0")
        elif largest > _STEEPEST * abs(self.denominator[0]):
            reason = f"begins with a factor that is nothing beside others: {self.denominator[0]:g} of {largest:g}"
            yield Problem("denominator", reason, f"coefficients of at most {_STEEPEST:g} times the first one")
        if not zeros:
            yield Problem("numerator", "is zero throughout", "at least one coefficient other than 0")
        elif len(self.numerator) - zeros[0] >= len(self.denominator):
            yield Problem("numerator", "has no lower order than denominator", "fewer coefficients than denominator has")

    def _root_problems(self) -> Iterator[Problem]:
        for key in ("numerator", "denominator"):
            if getattr(self, key) is not None:
                yield Problem(key, "stands beside poles", "the transfer function in one form only")
        poles, zeros = self.poles_hz or (), self.zeros_hz or ()
        for key, roots, dampings in (
            ("pole_dampings", poles, self.pole_dampings or ()),
            ("zero_dampings", zeros, self.zero_dampings or ()),
        ):
            if len(dampings) != len(roots):
                counts = f"has {counted(len(dampings), 'item')} where {key[:4]}s has {len(roots)}"
                yield Problem(key, counts, f"one damping for each of {key[:4]}s")
        if any(d <= 0.0 for d in self.pole_dampings or ()):
            yield Problem("pole_dampings", "has an unstable pole", "dampings above 0")
        orders = [
            sum(2 if abs(d) < 1.0 else 1 for d in each or ()) for each in (self.pole_dampings, self.zero_dampings)
        ]
        if orders[1] >= orders[0]:
            counts = f"makes {counted(orders[1], 'zero')} over {counted(orders[0], 'pole')}"
            yield Problem("zeros", counts, "fewer zeros than poles, pairs counted twice")

    @property
    def roots(self) -> tuple[tuple[complex, ...], tuple[complex, ...]]:
        """Zeros and poles in rad/s, conjugates included."""
        if self.poles_hz is None:
            import numpy as np

            found = (np.roots(each or ()) for each in (self.numerator, self.denominator))
            zeros, poles = (tuple(complex(r) for r in roots) for roots in found)
            return zeros, poles
        return (
            roots_from_damping(self.zeros_hz or (), self.zero_dampings or ()),
            roots_from_damping(self.poles_hz, self.pole_dampings or ()),
        )


def roots_from_damping(frequencies_hz: tuple[float, ...], dampings: tuple[float, ...]) -> tuple[complex, ...]:
    """Roots (rad/s) from natural frequencies and damping ratios: a pair, or one real root for a damping of 1 or -1.

    Args:
        frequencies_hz: Natural frequencies, in Hz.
        dampings: Damping ratio of each, positive in the left half plane.
    """
    roots: list[complex] = []
    for frequency, damping in zip(frequencies_hz, dampings, strict=True):
        natural = 2.0 * math.pi * frequency
        if abs(damping) >= 1.0:
            roots.append(complex(-math.copysign(natural, damping)))
        else:
            root = natural * complex(-damping, math.sqrt(1.0 - damping**2))
            roots += [root, root.conjugate()]
    return tuple(roots)


def least_alpha_1_v(beta_1_v: float, gamma_1_v: float, eta_1_v: float) -> float:
    """What alpha of a Bouc-Wen model has to be above, in 1/V, so that h decays on each side of 0 in both directions.

    Args:
        beta_1_v: Share of the decay that turns with the direction, 1/V.
        gamma_1_v: What tells the signs of h apart, 1/V.
        eta_1_v: What tells rising from falling drive, 1/V.
    """
    return max(abs(beta_1_v + eta_1_v * s) - s * gamma_1_v for s in (1.0, -1.0))


class BoucWenTable(Table):
    """Parameters of the rate-dependent Bouc-Wen model, with angle in rad and drive in V (paper, Eq. 3).

    gamma, eta and exponent generalise Eq. 3, which is what stands when they are left out (see `hysteresis.BoucWen`).
    """

    d1_rad_v: MirrorGain = Field(description="output for a volt without hysteresis (Eq. 3)")
    d2_s_v: Annotated[float, Quantity("s/V")] = Field(
        description="how that output changes with the rate: d1 exp(-d2 u')"
    )
    epsilon_rad_v: Annotated[float, Quantity("rad/V", "mrad/V")] = Field(
        description="slope of the hysteresis behind a reversal"
    )
    delta_s_v: Annotated[float, Quantity("s/V")] = Field(
        description="how that slope grows with the rate: epsilon exp(delta |u'|)"
    )
    alpha_1_v: Annotated[float, Quantity("1/V")] = Field(description="decay of the hysteresis with each volt of travel")
    beta_1_v: Annotated[float, Quantity("1/V")] = Field(
        description="share of the decay that turns with the direction of travel"
    )
    gamma_1_v: Annotated[float, Quantity("1/V")] = Field(
        default=0.0, description="tells the signs of h apart; left out, they are alike"
    )
    eta_1_v: Annotated[float, Quantity("1/V")] = Field(
        default=0.0, description="tells rising from falling drive; left out, they are alike"
    )
    exponent: Annotated[float, Quantity("", least=1.0, most=100.0)] = Field(
        default=1.0, description="of h in the decay; left out, 1 as in Eq. 3"
    )

    def problems(self) -> Iterator[Problem]:
        """Hysteresis that stays bounded."""
        least = least_alpha_1_v(self.beta_1_v, self.gamma_1_v, self.eta_1_v)
        if not self.alpha_1_v > least:
            size = format_limit(least, "1/V", least=True)
            names = "beta" if self.gamma_1_v == self.eta_1_v == 0.0 else "what beta, gamma and eta take off it"
            yield Problem(
                "alpha", f"is not above the size of {names} ({size}), so h would grow without bound", f"above {size}"
            )


class PrandtlIshlinskiiTable(Table):
    """Play operators: half widths in V, rising from 0 V, and a weight in rad/V for each."""

    thresholds_v: Annotated[tuple[float, ...], Several(Quantity("V", least=0.0), rising=True)] = Field(
        description="half width of each play operator"
    )
    weights_rad_v: Annotated[tuple[float, ...], Several(Quantity("rad/V", "urad/V", least=0.0))] = Field(
        description="output of each play operator for a volt"
    )
    widening_s: DurationOrZero = Field(
        default=0.0, description="growth of the thresholds above 0 with the drive's rate; or none"
    )

    def problems(self) -> Iterator[Problem]:
        """A weight for each threshold, one of them doing something."""
        if self.thresholds_v[0] != 0.0:
            yield Problem("thresholds", "does not begin at 0 V", 'a first threshold of "0 V"')
        if len(self.weights_rad_v) != len(self.thresholds_v):
            counts = f"has {counted(len(self.weights_rad_v), 'item')} where thresholds has {len(self.thresholds_v)}"
            yield Problem("weights", counts, "one weight for each threshold")
        if not any(self.weights_rad_v):
            yield Problem("weights", "is zero throughout", "at least one weight above 0")


class CreepTable(Table):
    """Creep beside the hysteresis: drive behind first-order lags, with a weight in rad/V for each time constant."""

    time_constants_s: Annotated[tuple[float, ...], Several(Quantity("s", above=0.0), rising=True)] = Field(
        description="of each first-order lag"
    )
    weights_rad_v: Annotated[tuple[float, ...], Several(Quantity("rad/V", "urad/V"))] = Field(
        description="output that each lag creeps to for a volt"
    )

    def problems(self) -> Iterator[Problem]:
        """A weight for each lag."""
        if len(self.weights_rad_v) != len(self.time_constants_s):
            counts = (
                f"has {counted(len(self.weights_rad_v), 'item')} where time_constants has {len(self.time_constants_s)}"
            )
            yield Problem("weights", counts, "one weight for each time constant")


def _one_model(table: "Mirror | Comparison") -> Iterator[Problem]:
    given = (table.bouc_wen is not None) + (table.prandtl_ishlinskii is not None)
    if given != 1:
        found = "two hysteresis models" if given else "no hysteresis model"
        yield Problem("", f"has {found}", "exactly one of the tables bouc_wen and prandtl_ishlinskii")


class Comparison(Table):
    """A second hysteresis model of the same mirror, run beside the first."""

    bouc_wen: BoucWenTable | None = None
    prandtl_ishlinskii: PrandtlIshlinskiiTable | None = None

    def problems(self) -> Iterator[Problem]:
        """Exactly one model."""
        return _one_model(self)


# --------------------------------------------------------------------------------------------------------- uncertainty
@dataclass(frozen=True, slots=True)
class KeyList(Several):
    """A list of keys as text; `shown` is an example."""

    shown: str = '["bouc_wen.d1", "linear.poles.1"]'

    def read(self, value: object) -> Any:
        """The keys; raises `ProblemsError`."""
        if not isinstance(value, list | tuple) or not value or not all(isinstance(v, str) for v in value):
            raise ProblemsError(Problem("", "is not a list of keys in quotes", f"{self.wanted}: {self.example}"))
        if len(value) > self.most:
            raise ProblemsError(Problem("", f"is a list of {len(value)} items", f"at most {self.most} items"))
        return tuple(value)

    @property
    def wanted(self) -> str:
        """What the key expects, in words."""
        return "a list of keys inside the mirror, items of lists counted from 1"

    @property
    def example(self) -> str:
        """A list of keys."""
        return self.shown

    def __get_pydantic_json_schema__(self, schema: CoreSchema, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        """An array of texts."""
        return {"type": "array", "minItems": 1, "items": {"type": "string"}}


@dataclass(frozen=True, slots=True)
class _SeveralOrNone(Several):
    """A list that may be empty."""

    def read(self, value: object) -> tuple[float, ...]:
        return () if value in ([], ()) else Several.read(self, value)

    def __get_pydantic_json_schema__(self, schema: CoreSchema, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        return {"type": "array", "items": self.each.__get_pydantic_json_schema__(schema, handler)}


class Uncertainty(Table):
    """How well the identification knows its parameters: standard errors relative to the values, and correlation.

    `parameters` are keys inside the mirror, "bouc_wen.d1" or "linear.poles.1" (items count from 1); a list without a
    number is one parameter, its items scale together. `correlation` is that of the values, the lower triangle without
    the diagonal row by row; of a list that scales together its first item other than 0 counts.
    """

    parameters: Annotated[tuple[str, ...], KeyList(Quantity(""))] = Field(
        description="keys inside the mirror, items counted from 1"
    )
    standard_errors: Annotated[tuple[float, ...], Several(Quantity("", least=0.0, most=1.0))] = Field(
        description="relative to the values"
    )
    correlation: Annotated[tuple[float, ...], _SeveralOrNone(Quantity("", least=-1.0, most=1.0))] = Field(
        default=(), description="lower triangle without the diagonal, row by row; left out, there is none"
    )

    def problems(self) -> Iterator[Problem]:
        """Counts that fit, and correlations that can be together."""
        count = len(self.parameters)
        pairs = count * (count - 1) // 2
        if len(self.standard_errors) != count:
            found = f"has {counted(len(self.standard_errors), 'item')} where parameters has {count}"
            yield Problem("standard_errors", found, "one standard error for each parameter")
        if len(self.correlation) not in (0, pairs):
            found = f"has {counted(len(self.correlation), 'item')} where {count} parameters have {pairs} pairs"
            yield Problem("correlation", found, f"{pairs} numbers, the lower triangle without the diagonal, or none")
        elif (least := self._least_eigenvalue()) < -INDEFINITE:
            found = f"is not positive semidefinite: its smallest eigenvalue is {least:.3g}"
            yield Problem("correlation", found, "correlations that can be together, as the fit gave them")

    @property
    def correlation_rows(self) -> list[list[float]]:
        """The whole correlation matrix."""
        size = range(len(self.parameters))
        below = iter(self.correlation or (0.0,) * (len(size) * (len(size) - 1) // 2))
        lower = [[next(below) for _ in range(i)] for i in size]
        return [[1.0 if i == j else lower[max(i, j)][min(i, j)] for j in size] for i in size]

    def _least_eigenvalue(self) -> float:
        if not self.correlation:
            return 1.0
        import numpy as np

        return float(np.linalg.eigvalsh(np.array(self.correlation_rows))[0])


class Place(NamedTuple):
    """Where a parameter stands: table and field of the record, and the item of a list (from 0) or None for all."""

    table: str
    field: str
    item: int | None


_UNCERTAIN = {
    "linear": ("numerator", "denominator", "poles", "pole_dampings", "zeros", "zero_dampings"),
    "bouc_wen": tuple(info.alias or name for name, info in BoucWenTable.model_fields.items()),
    "prandtl_ishlinskii": ("thresholds", "weights", "widening"),
    "creep": ("time_constants", "weights"),
}


def place(mirror: "Mirror", key: str) -> Place:
    """Where the parameter of a dotted key stands in a mirror.

    Args:
        mirror: The mirror's table.
        key: Dotted key of the parameter, of an item in a list with its place from 1 behind it.

    Raises:
        ProblemsError: For a key that is no parameter of this mirror, and for a value that has no relative error: 0, and
            the damping 1 of a real root.
    """
    name, _, rest = key.partition(".")
    alias, _, number = rest.partition(".")
    tables = [each for each in _UNCERTAIN if getattr(mirror, each) is not None]
    if name not in tables:
        raise _refusal(key, "is in no table of this mirror", f"a key of {', '.join(tables)}")
    table = getattr(mirror, name)
    fields = {info.alias or field: field for field, info in type(table).model_fields.items()}
    given = [each for each in _UNCERTAIN[name] if getattr(table, fields[each]) is not None]
    if alias not in given:
        raise _refusal(key, f"is no parameter of this mirror's {name}", f"one of {', '.join(given)}")
    value = getattr(table, fields[alias])
    values = value if isinstance(value, tuple) else (value,)
    item = _item(key, number, len(value) if isinstance(value, tuple) else 0)
    chosen = values if item is None else values[item : item + 1]
    if not any(chosen):
        raise _refusal(key, "is 0 in this mirror, and nothing is relative to 0", "a parameter that is not held at 0")
    if alias.endswith("dampings") and any(abs(damping) == 1.0 for damping in chosen):
        raise _refusal(key, "is the damping of a real root, 1 by definition", "the damping of a pair of roots")
    return Place(name, fields[alias], item)


def _item(key: str, number: str, items: int) -> int | None:
    if not number:
        return None
    if not items:
        raise _refusal(key, "counts the items of a single value", "the key without a number")
    if not (number.isascii() and number.isdigit() and 1 <= int(number[:6]) <= items):
        raise _refusal(key, f"names no item of a list of {items}", f"a number from 1 to {items}")
    return int(number) - 1


def _refusal(key: str, reason: str, expected: str) -> ProblemsError:
    return ProblemsError(Problem("uncertainty.parameters", f'has "{key[:60]}", which {reason}', expected))


def _uncertainty_problems(mirror: "Mirror", uncertainty: Uncertainty) -> Iterator[Problem]:
    """Parameters that this mirror does not have, and values named twice."""
    taken: dict[tuple[str, str], set[int | None]] = {}
    for key in uncertainty.parameters:
        try:
            found = place(mirror, key)
        except ProblemsError as error:
            yield from error.problems
            continue
        items = taken.setdefault(found[:2], set())
        if found.item in items or (items and None in (found.item, *items)):
            yield from _refusal(key, "stands twice, or beside its whole list", "each value once").problems
        items.add(found.item)


class Mirror(Table):
    """The fast steering mirror: one hysteresis model, and the linear part that its composition asks for."""

    name: Name = Field(description="what the report calls the mirror")
    travel_rad: Angle = Field(description="from stop to stop")
    composition: Literal["cascade", "additive", "static"] = Field(
        description="cascade: hysteresis drives the linear part; additive: it is added behind; static: no linear part"
    )
    rate_limit_v_s: Rate = Field(description="fastest drive that the hysteresis was identified for")
    bias_v: Voltage = Field(description="drive about which the mirror works")
    drive_min_v: Voltage = Field(description="lowest drive that the hysteresis was identified for")
    drive_max_v: Voltage = Field(description="highest drive that the hysteresis was identified for")
    linear: LinearPart | None = None
    bouc_wen: BoucWenTable | None = None
    prandtl_ishlinskii: PrandtlIshlinskiiTable | None = None
    creep: CreepTable | None = None
    comparison: Comparison | None = None
    uncertainty: Uncertainty | None = None

    def problems(self) -> Iterator[Problem]:
        """One model, a linear part where the composition has one, a bias within the drive range, known parameters."""
        yield from _one_model(self)
        if not self.drive_min_v < self.drive_max_v:
            low = format_input(self.drive_min_v, "V")
            yield Problem("drive_max", f"is not above drive_min ({low})", f"a voltage above {low}")
        elif not self.drive_min_v <= self.bias_v <= self.drive_max_v:
            span = f"{format_input(self.drive_min_v, 'V')} to {format_input(self.drive_max_v, 'V')}"
            yield Problem("bias", f"is outside drive_min to drive_max ({span})", span)
        if self.composition == "static" and self.linear is not None:
            advice = 'the table linear removed, or composition = "cascade"'
            yield Problem("linear", 'does not belong to composition = "static"', advice)
        if self.composition != "static" and self.linear is None:
            advice = 'a table linear, or composition = "static"'
            yield Problem("composition", f'is "{self.composition}" but the table linear is missing', advice)
        if self.uncertainty is not None:
            yield from _uncertainty_problems(self, self.uncertainty)
