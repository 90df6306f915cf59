"""What a key of the mission file may hold: a quantity with a unit and bounds, or a list of them.

Both plug into pydantic as annotations, `Annotated[float, Quantity("W", above=0.0)]`, and report in the user's words.
"""

import math
import re
from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import dataclass, fields
from functools import cache
from itertools import pairwise
from typing import Any, ClassVar, NamedTuple, Self, get_type_hints

from pydantic import BaseModel, ConfigDict, GetCoreSchemaHandler, GetJsonSchemaHandler, model_validator
from pydantic.fields import FieldInfo
from pydantic_core import CoreSchema, core_schema

from microrad.core.units import UnitError, format_input, format_quantity, kind_of, parse_quantity

MOST_ITEMS = 1000
"""Items of a list beyond which it is taken for a mistake."""
MONTHS = 12
"""Of a year, for values by month (`Monthly`)."""

_LARGEST = 1e100  # plain number: products of three are still floats

UNKNOWN = "unknown"
"""What a preset holds where no source prints a value."""
_EXAMPLES = (5.0, 1.0, 0.5, 20.0, 45.0, 100.0, 1e3, 0.1, 1e-3)
NOT_PUBLISHED = "is in no source that the preset names, and has to be given"

_PATTERN = r"^[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]{1,3})? ?[A-Za-zµμ1].*$"


class Problem(NamedTuple):
    """What is wrong with a key (dotted, seen from the table that reports it) and what is expected of it."""

    key: str
    reason: str
    expected: str


class ProblemsError(ValueError):
    """Values that do not fit, each as one `Problem`."""

    def __init__(self, *problems: Problem) -> None:
        """Join the problems to one message."""
        super().__init__("; ".join(f"{p.key} {p.reason}: expected {p.expected}".strip() for p in problems))
        self.problems = problems


@dataclass(frozen=True, slots=True)
class Quantity:
    """A value in `unit` (SI; "" is a plain number), above or at least or at most a bound in that unit.

    `typical` is the unit in which an example of it is written.
    """

    unit: str
    typical: str = ""
    above: float | None = None
    least: float | None = None
    most: float | None = None

    def read(self, value: object) -> float:
        """SI value of what a file holds, a text of number and unit or a plain number; raises `UnitError`."""
        if value == UNKNOWN:
            raise UnitError(value, NOT_PUBLISHED, self.wanted, self.example)
        number = self._parsed(value) if self.unit else _plain_number(value)
        if fault := self.out_of_bounds(number):
            raise UnitError(value, fault, self.wanted, self.example)
        return number

    def _parsed(self, value: object) -> float:
        try:
            return parse_quantity(value, self.unit, self.typical)
        except UnitError as refused:
            if not self.out_of_bounds(parse_quantity(refused.example, self.unit)):
                raise
            raise UnitError(value, refused.reason, refused.expected, self.example) from None

    @property
    def example(self) -> str:
        """A value within the bounds; whether it is a good one is the mission's affair."""
        unit = self.typical or kind_of(self.unit)[1]
        for number in _EXAMPLES:
            text = f"{number:g} {unit}" if self.unit else f"{number:g}" if number % 1 else f"{number:.1f}"
            value = parse_quantity(text, self.unit) if self.unit else number
            if not self.out_of_bounds(value):
                return text
        return f"5 {unit}" if self.unit else "1.0"

    @property
    def wanted(self) -> str:
        """What the key expects, in words."""
        noun = f"{kind_of(self.unit)[0]} with its unit" if self.unit else "a number without quotes"
        return f"{noun}, {self.limits}" if self.limits else noun

    @property
    def limits(self) -> str:
        """The bounds in words."""
        bounds = [("above", self.above), ("at least", self.least), ("at most", self.most)]
        return ", ".join(f"{word} {self._show(bound)}" for word, bound in bounds if bound is not None)

    def check(self, name: str, value: float, why: str = "") -> None:
        """Check a value that comes from no file.

        Args:
            name: What the value is, in the words of the message.
            value: The value, in the unit of the quantity.
            why: Why the bounds hold, for the message.

        Raises:
            ValueError: For a value that is not finite or out of bounds.
        """
        if not math.isfinite(value) or self.out_of_bounds(value):
            limits, reason = ", ".join(filter(None, ("finite", self.limits))), f"; {why}" if why else ""
            raise ValueError(f"{name} is {self._beyond(value)}: it must be {limits}{reason}")

    def out_of_bounds(self, number: float) -> str:
        """Why a number is not allowed, or nothing."""
        if self.above is not None and not number > self.above:
            return f"is not above {self._show(self.above)}"
        if self.least is not None and not number >= self.least:
            return f"is below {self._show(self.least)}"
        if self.most is not None and not number <= self.most:
            return f"is above {self._show(self.most)}"
        return ""

    def _beyond(self, value: float) -> str:
        """A value that is refused, in as many digits as tell it from the bounds."""
        bounds = [each for each in (self.above, self.least, self.most) if each is not None]
        for digits in range(4, 13):
            shown = self._show(value, digits)
            if shown not in [self._show(each, digits) for each in bounds]:
                return shown.strip()
        return self._show(value).strip()

    def _show(self, number: float, digits: int = 4) -> str:
        if self.typical.startswith("deg"):  # whoever writes degrees does not read radians
            return f"{number / parse_quantity(f'1 {self.typical}', self.unit):.{digits}g} {self.typical}"
        return format_quantity(number, self.unit, digits) if self.unit else f"{number:.{max(digits, 6)}g}"

    def __get_pydantic_core_schema__(self, source: object, handler: GetCoreSchemaHandler) -> CoreSchema:
        """Read the text in place of pydantic's own number."""
        return core_schema.no_info_plain_validator_function(self.read)

    def __get_pydantic_json_schema__(self, schema: CoreSchema, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        """Text with a unit for an editor; bounds only where the number stands without one."""
        if self.unit:
            return {"type": "string", "pattern": _PATTERN, "x-si-unit": self.unit, "examples": [self.example]}
        bounds = {"exclusiveMinimum": self.above, "minimum": self.least, "maximum": self.most}
        return {"type": "number", **{key: bound for key, bound in bounds.items() if bound is not None}}


@dataclass(frozen=True, slots=True)
class Whole(Quantity):
    """A whole number from `least` to `most`, compared as it stands: a seed has more digits than a float."""

    def read(self, value: object) -> int:
        """The number; raises `UnitError`."""
        if isinstance(value, bool) or not isinstance(value, int):
            reason = NOT_PUBLISHED if value == UNKNOWN else "is not a whole number"
            raise UnitError(value, reason, self.wanted, self.example)
        if fault := self.out_of_bounds(value):
            raise UnitError(value, fault, self.wanted, self.example)
        return value

    def out_of_bounds(self, number: float) -> str:
        """Why a number is not allowed, or nothing."""
        return "is not whole" if number != int(number) else Quantity.out_of_bounds(self, number)

    def check(self, name: str, value: float, why: str = "") -> None:
        """As that of `Quantity`; a number that is not whole is refused as such."""
        if value % 1.0 and math.isfinite(value):
            raise ValueError(f"{name} is {format_input(value, '')}: it must be whole, {self.limits}")
        Quantity.check(self, name, value, why)

    @property
    def example(self) -> str:
        """A number within the bounds."""
        return f"{max(int(self.least or 0), 2)}"

    @property
    def wanted(self) -> str:
        """What the key expects, in words."""
        return f"a whole number without quotes, from {self._show(self.least or 0)} to {self._show(self.most or 0)}"

    def _show(self, number: float, digits: int = 4) -> str:
        return Quantity._show(self, number, digits) if number % 1 else str(int(number))

    def __get_pydantic_json_schema__(self, schema: CoreSchema, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        """A whole number with its bounds."""
        return {"type": "integer", "minimum": self.least, "maximum": self.most}


@dataclass(frozen=True, slots=True)
class Share(Quantity):
    """A number above 0 (or at least `least`) and below `below`; it has a unit only where it is read from no file."""

    below: float = 1.0

    def out_of_bounds(self, number: float) -> str:
        """Why a number is not allowed, or nothing."""
        inside = (self.least is not None or number > 0.0) and number < self.below
        fault = "" if inside else f"is not above 0 and below {self._show(self.below)}"
        return Quantity.out_of_bounds(self, number) or fault

    @property
    def example(self) -> str:
        """A number between the bounds, half way in size where there is a least."""
        return (
            f"{self.below / 2:g}" if not self.least else f"{10.0 ** round(math.log10(self.least * self.below) / 2):g}"
        )

    @property
    def limits(self) -> str:
        """The bounds in words."""
        lowest = "above 0" if self.least is None else f"at least {self._show(self.least)}"
        return f"{lowest} and below {self._show(self.below)}"

    def __get_pydantic_json_schema__(self, schema: CoreSchema, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        """A number with its bounds."""
        least = {"exclusiveMinimum": 0.0} if self.least is None else {"minimum": self.least}
        return {"type": "number", **least, "exclusiveMaximum": self.below}


@dataclass(frozen=True, slots=True)
class Switch(Quantity):
    """True or false."""

    def read(self, value: object) -> bool:
        """The value; raises `UnitError`."""
        if not isinstance(value, bool):
            reason = NOT_PUBLISHED if value == UNKNOWN else "is neither true nor false"
            raise UnitError(value, reason, self.wanted, self.example)
        return value

    @property
    def example(self) -> str:
        """One of the two."""
        return "true"

    @property
    def wanted(self) -> str:
        """What the key expects, in words."""
        return "true or false, without quotes"

    def __get_pydantic_json_schema__(self, schema: CoreSchema, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        """A boolean."""
        return {"type": "boolean"}


@dataclass(frozen=True, slots=True)
class OrWord(Quantity):
    """A quantity, or one word in its place, which is read as `stands_for`; `meaning` follows the word in messages."""

    word: str = ""
    meaning: str = ""
    stands_for: float | str = math.nan

    def read(self, value: object) -> float | str:  # type: ignore[override]
        """SI value of the text, or what the word stands for; raises `UnitError`."""
        if value == self.word:
            return self.stands_for
        try:
            return Quantity.read(self, value)
        except UnitError as error:
            raise UnitError(value, error.reason, self.wanted, error.example) from None

    @property
    def wanted(self) -> str:
        """What the key expects, in words."""
        return f'{Quantity.wanted.fget(self)}, or "{self.word}"{self.meaning}'  # type: ignore[attr-defined]

    def __get_pydantic_json_schema__(self, schema: CoreSchema, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        """What a quantity has for an editor, or the word."""
        return {"anyOf": [Quantity.__get_pydantic_json_schema__(self, schema, handler), {"const": self.word}]}


@dataclass(frozen=True, slots=True)
class Several:
    """A list of at least one quantity and of at most `most`; rising lists are strictly increasing.

    `example_list` is an example in TOML, where a list of one item would be refused.
    """

    each: Quantity
    rising: bool = False
    most: int = MOST_ITEMS
    example_list: str = ""

    def read(self, value: object) -> tuple[float, ...]:
        """SI values of the list; raises `ProblemsError` with every item that does not fit."""
        if value == UNKNOWN:
            raise ProblemsError(Problem("", NOT_PUBLISHED, self.wanted))
        if not isinstance(value, list | tuple) or not value:
            raise ProblemsError(Problem("", "is not a list with something in it", self.wanted))
        if len(value) > self.most:
            raise ProblemsError(Problem("", f"is a list of {len(value)} items", f"at most {self.most} items"))
        numbers, problems = [], []
        for place, item in enumerate(value, 1):
            try:
                numbers.append(self.each.read(item))
            except UnitError as error:
                problems.append(Problem("", f"item {place}: {error}", self.wanted))
        if not problems and self.rising and any(b <= a for a, b in pairwise(numbers)):
            problems.append(Problem("", "does not rise from item to item", self.wanted))
        if problems:
            raise ProblemsError(*problems)
        return tuple(numbers)

    @property
    def wanted(self) -> str:
        """What the key expects, in words."""
        return f"a list, {'rising, ' if self.rising else ''}each item {self.each.wanted}"

    @property
    def example(self) -> str:
        """A list of one item, unless another one is shown."""
        if self.example_list:
            return self.example_list
        return f'["{self.each.example}"]' if self.each.unit else f"[{self.each.example}]"

    def __get_pydantic_core_schema__(self, source: object, handler: GetCoreSchemaHandler) -> CoreSchema:
        """Read the list in place of pydantic's own tuple."""
        return core_schema.no_info_plain_validator_function(self.read)

    def __get_pydantic_json_schema__(self, schema: CoreSchema, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        """An array of what each item is."""
        return {"type": "array", "minItems": 1, "items": self.each.__get_pydantic_json_schema__(schema, handler)}


@dataclass(frozen=True, slots=True)
class Monthly(Several):
    """One number that holds all year, or a list of twelve, January to December; read as a tuple of 1 or of 12."""

    def read(self, value: object) -> tuple[float, ...]:
        """The one number, or the twelve; raises `UnitError` or `ProblemsError`."""
        if not isinstance(value, list | tuple):
            try:
                return (self.each.read(value),)
            except UnitError as error:
                raise UnitError(value, error.reason, self.wanted, error.example) from None
        if len(value) != MONTHS:
            raise ProblemsError(Problem("", f"is a list of {len(value)}, and a year has {MONTHS} months", self.wanted))
        return Several.read(self, value)

    @property
    def wanted(self) -> str:
        """What the key expects, in words."""
        return f"{self.each.wanted}, or a list of {MONTHS} such, January to December"

    @property
    def example(self) -> str:
        """One number."""
        return self.each.example

    def __get_pydantic_json_schema__(self, schema: CoreSchema, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        """One item, or an array of twelve."""
        one = self.each.__get_pydantic_json_schema__(schema, handler)
        return {"anyOf": [one, {"type": "array", "minItems": MONTHS, "maxItems": MONTHS, "items": one}]}


def _plain_number(value: object) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise UnitError(value, "is not a plain number", "a number without quotes", "1.0")
    try:
        number = float(value)
    except OverflowError:
        number = math.inf
    if not math.isfinite(number):
        raise UnitError(value, "is not a finite number", "a finite number", "1.0")
    if abs(number) > _LARGEST:
        raise UnitError(value, f"is beyond {_LARGEST:g}", "a number of a mission, or of a mirror", "1.0")
    return number


class Bounded:
    """A record that refuses what its annotations do not allow, as `Annotated[float, Quantity("W", least=0.0)]`.

    A text behind the bounds says why they hold. The default of a field is allowed whatever they are. `REFUSAL` is the
    error that is raised.
    """

    __slots__ = ()
    REFUSAL: ClassVar[type[ValueError]] = ValueError

    def __post_init__(self) -> None:
        """Raises the record's error if a value is not finite or out of its bounds."""
        record: Any = type(self)
        own = getattr(self, "name", "")
        for name, default, rule, why in _bounds(record):
            value = getattr(self, name)
            if value == default:
                continue
            try:
                rule.check(f"{record.__name__}.{name}{f' of {own}' if own else ''}", value, why)
            except ValueError as error:
                raise self.REFUSAL(str(error)) from None


@cache
def _bounds(record: Any) -> tuple[tuple[str, object, Quantity, str], ...]:
    """Name, default, rule and reason of each field of a record that has bounds."""
    hints, found = get_type_hints(record, include_extras=True), []
    for each in fields(record):
        bounds = getattr(hints[each.name], "__metadata__", ())
        if bounds and isinstance(bounds[0], Quantity):
            found.append((each.name, each.default, bounds[0], "".join(bounds[1:])))
    return tuple(found)


def rule_of_field(info: FieldInfo) -> Quantity | Several | None:
    """What a key of a table may hold; of a key that may be left out it stands inside the annotation."""
    inner = [rule for kind in getattr(info.annotation, "__args__", ()) for rule in getattr(kind, "__metadata__", ())]
    return next((rule for rule in (*info.metadata, *inner) if isinstance(rule, Quantity | Several)), None)


_UNIT = re.compile(r"(_(rad|m|s|hz|v|w|a|db|bit|photon|sr|m2|m3|rad2|hz2|1|sqrt))+$")


class Table(BaseModel):
    """A table of a mission or plan file: frozen, strict, no key beyond the named ones.

    A file calls a field by its name without the unit at its end, unless the field has an alias of its own.
    """

    model_config = ConfigDict(
        strict=True,
        frozen=True,
        extra="forbid",
        allow_inf_nan=False,
        alias_generator=lambda name: _UNIT.sub("", name),
    )

    @classmethod
    def rule_of(cls, key: str) -> tuple[str, Quantity]:
        """Name and rule of the quantity that a file calls `key`; a missing one is a KeyError."""
        for name, info in cls.model_fields.items():
            rule = rule_of_field(info)
            if isinstance(rule, Quantity) and (info.alias or name) == key:
                return name, rule
        raise KeyError(key)

    def with_value(self, key: str, value: object) -> Self:
        """The table with another value for one attribute; the value is not checked.

        Args:
            key: Dotted name of the attribute, such as "communication.data_rate_bit_s".
            value: The new value, in the SI unit of the attribute.
        """
        name, _, rest = key.partition(".")
        return self.model_copy(update={name: getattr(self, name).with_value(rest, value) if rest else value})

    def choice_problems(
        self,
        choice: str,
        needed: Mapping[str, str],
        allowed: Collection[str] = (),
        instead: Callable[[str], str] = lambda key: "",
    ) -> Iterator[Problem]:
        """Of the keys that may be left out: those that a choice needs and that are missing, and those of no use to it.

        Args:
            choice: The choice in words, such as 'kind = "circular"'.
            needed: The keys that it needs, each with a value that could stand there.
            allowed: Other keys that may be there.
            instead: Gives the choice that a key belongs to, in words, or nothing.
        """
        for name, info in type(self).model_fields.items():
            if info.is_required():
                continue
            key, present = info.alias or name, getattr(self, name) is not None
            if key in needed and not present:
                yield Problem(key, f"is missing, and {choice} needs it", f"{key} = {needed[key]} would do")
            if present and key not in (*needed, *allowed):
                other = f", or {instead(key)}" if instead(key) else ""
                yield Problem(key, f"does not belong to {choice}", f"this line removed{other}")

    def problems(self) -> Iterator[Problem]:
        """What does not fit together in a table whose keys are each in order."""
        return iter(())

    @model_validator(mode="after")
    def _fits_together(self) -> Self:
        problems = tuple(self.problems())
        if problems:
            raise ProblemsError(*problems)
        return self
