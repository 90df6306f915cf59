"""What a co-simulation unit (FMU) shows of itself: its variables with units, and the model description."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from importlib.metadata import version as version_of
from typing import Literal

from microrad.core import kernels
from microrad.export.records import LoopUnit, PlantUnit
from microrad.export.templating import render

Version = Literal["2.0", "3.0"]
Causality = Literal["independent", "input", "output", "parameter", "local"]
Range = Literal["any", "not negative", "positive"]

UNITS = (
    ("s", (("s", 1),), ()),
    ("V", (("kg", 1), ("m", 2), ("s", -3), ("A", -1)), ()),
    ("m", (("m", 1),), (("um", "1e6"),)),
    ("rad", (("rad", 1),), (("urad", "1e6"), ("mrad", "1e3"))),
    ("Hz", (("s", -1),), ()),
    ("V/s", (("kg", 1), ("m", 2), ("s", -4), ("A", -1)), ()),
    ("rad/V", (("kg", -1), ("m", -2), ("s", 3), ("A", 1), ("rad", 1)), ()),
    ("s/V", (("kg", -1), ("m", -2), ("s", 4), ("A", 1)), ()),
    ("1/V", (("kg", -1), ("m", -2), ("s", 3), ("A", 1)), ()),
)
"""Units of the variables: name, powers of the base units of the SI, and units to show it in, with their factors."""

BOUC_WEN: tuple[tuple[str, str, int, str | None, Range, str], ...] = (
    ("d1", "d1", kernels.D1, None, "any", "linear gain"),
    ("d2_s_v", "d2", kernels.D2, "s/V", "any", "change of the linear gain with the rate of the drive"),
    ("epsilon", "epsilon", kernels.EPSILON, None, "any", "gain of the hysteresis"),
    ("delta_s_v", "delta", kernels.DELTA, "s/V", "any", "growth of the hysteresis with the rate of the drive"),
    ("alpha_1_v", "alpha", kernels.ALPHA, "1/V", "any", "decay of the hysteresis"),
    ("beta_1_v", "beta", kernels.BETA, "1/V", "any", "decay that tells loading from unloading"),
    ("gamma_1_v", "gamma", kernels.GAMMA, "1/V", "any", "decay that tells the signs of the hysteresis apart"),
    ("eta_1_v", "eta", kernels.ETA, "1/V", "any", "decay that tells rising from falling drive"),
    ("rate_limit_v_s", "rate_limit", kernels.RATE_LIMIT, "V/s", "positive", "fastest rate that was identified"),
    ("bias_v", "bias", kernels.BIAS, "V", "any", "drive at rest"),
)
"""Parameters of a Bouc-Wen element: name, field in C, column of the kernel, unit (None: of a gain), range, meaning."""

PLANT_COUNTERS = [
    ("rate_clamped", "plant.rate_clamped", "elements and plant steps beyond the identified rate"),
    ("slew_limited", "plant.slew_limited", "actuators and plant steps at the amplifier's slew limit"),
    ("faults", "plant.faults", "elements and plant steps whose hysteresis could not be advanced"),
]
CONTROLLER_COUNTERS = [
    ("saturated", "loop.controller.saturated", "commands that the limits cut off"),
    ("inverse_rate_clamped", "loop.controller.rate_clamped", "samples of the inverse beyond the identified rate"),
    ("rejected", "loop.controller.rejected", "readings that the controller did not accept"),
    ("controller_faults", "loop.controller.faults", "results that the controller did not give out"),
    ("lost", "loop.lost", "optical readings with the spot beyond the field of view"),
]
LEARNING_COUNTERS = [("fallbacks", "loop.controller.fallbacks", "returns of an inverse that learns to the frozen one")]
"""Counters of a plant, those that a loop has beside them, and those of one that learns: name, place in C, meaning."""


@dataclass(frozen=True, slots=True)
class Variable:
    """A variable of a unit; its place in the list is its value reference.

    ``size`` is the number of elements of an array; None for a scalar. ``place`` is where it stands in the C structure
    of an instance, an array from the element ``first`` there. It is a whole number if it ``counts``, else real.
    ``start`` has a number for each element. Outputs depend at once on the inputs ``dependencies``, by name.
    """

    name: str
    place: str
    causality: Causality
    description: str
    unit: str = ""
    start: tuple[float, ...] | None = None
    size: int | None = None
    first: int = 0
    counts: bool = False
    constant: bool = False
    range: Range = "any"
    dependencies: tuple[str, ...] = ()

    @property
    def variability(self) -> str:
        """How the variable may change, as the standard calls it."""
        if self.constant:
            return "constant"
        if self.causality == "parameter":
            return "fixed"
        return "discrete" if self.counts else "continuous"

    @property
    def initial(self) -> str | None:
        """Where the first value comes from, as the standard calls it; None where it goes without saying."""
        if self.constant or self.causality == "parameter":
            return "exact"
        return "calculated" if self.causality == "output" else None

    @property
    def least(self) -> str | None:
        """Lower bound of its numbers."""
        return None if self.range == "any" else "0"

    @property
    def begin(self) -> str:
        """Where it begins in the C structure of an instance."""
        return self.place if self.size is None else f"{self.place}[{self.first}]"

    @property
    def elements(self) -> "tuple[Variable, ...]":
        """The elements of an array, counted from 1, each a variable by itself; a scalar as it is."""
        if self.size is None:
            return (self,)
        return tuple(
            replace(
                self,
                name=f"{self.name}[{i + 1}]",
                place=f"{self.place}[{self.first + i}]",
                start=None if self.start is None else (self.start[i],),
                size=None,
                dependencies=tuple(f"{each}[{i + 1}]" for each in self.dependencies),
            )
            for i in range(self.size)
        )


def plant_of(unit: PlantUnit | LoopUnit) -> PlantUnit:
    """The plant of a unit."""
    return unit.plant if isinstance(unit, LoopUnit) else unit


def exponent(row: kernels.Floats) -> float:
    """Exponent of a Bouc-Wen element from its row of parameters."""
    return 1.0 + float(row[kernels.POWER])


def variables(unit: PlantUnit | LoopUnit, version: Version) -> tuple[Variable, ...]:
    """The variables of a unit by value reference: arrays in FMI 3.0, each element by itself in 2.0, which has none.

    Args:
        unit: The mirror with its amplifier, or a closed loop.
        version: Version of FMI.
    """
    arrays = _variables(unit)
    return arrays if version == "3.0" else tuple(element for each in arrays for element in each.elements)


def _variables(unit: PlantUnit | LoopUnit) -> tuple[Variable, ...]:
    found, counters = [Variable("time", "time_s", "independent", "simulation time", "s")], PLANT_COUNTERS
    if isinstance(unit, LoopUnit):
        found += _loop_signals(unit)
        learns = unit.controller.adaptation is not None
        counters = PLANT_COUNTERS + CONTROLLER_COUNTERS + (LEARNING_COUNTERS if learns else [])
    else:
        text = "command by actuator, from the bias, held over the communication step"
        found.append(_input("command_v", len(unit.plant.actuators), text, "V"))
    of = plant_of(unit)
    text = "drive by actuator behind the amplifier, as seen at its input, from the bias"
    found += [
        _output("line_of_sight_rad", len(of.optics), "line of sight by axis", "rad"),
        _output(f"mirror_{of.output_unit}", len(of.plant.outputs), "outputs of the mirror", of.output_unit, "plant.y"),
        _output("drive_v", len(of.plant.actuators), text, "V", "plant.u"),
    ]
    found += [Variable(name, place, "output", text, counts=True) for name, place, text in counters]
    return (*found, *_parameters(of), *_constants(unit))


def _loop_signals(unit: LoopUnit) -> list[Variable]:
    axes, actuators = unit.plant.optics.shape[0], len(unit.plant.plant.actuators)
    held = "taken at the begin of the communication step and held over it"
    error = _output("error_rad", axes, "error by axis: reference + disturbance - line of sight", "rad")
    text = "command by actuator that the last control sample gave, from the bias"
    return [
        _input("reference_rad", axes, f"reference by axis, {held}", "rad"),
        _input("disturbance_rad", axes, f"disturbance by axis, {held}", "rad"),
        replace(error, dependencies=("reference_rad", "disturbance_rad")),
        _output("command_v", actuators, text, "V", "loop.command_v"),
    ]


def _parameters(of: PlantUnit) -> list[Variable]:
    p, slew = of.plant, of.slew_step_v / of.plant.step_s
    found = [
        _parameter(name, f"plant.{name}", text, unit, start, "positive")
        for name, text, unit, start in (
            ("amplifier_bandwidth_hz", "first-order bandwidth of the amplifier", "Hz", of.bandwidth_hz),
            ("amplifier_slew_v_s", "slew limit of the amplifier, as seen at its input", "V/s", slew),
        )
    ]
    ending, gain = _gain(of)
    for e, row in enumerate(p.bouc_wen):
        within = f"bouc_wen[{e + 1}]."
        for name, field, column, unit, allowed, meaning in BOUC_WEN:
            place, start = f"plant.bouc_wen[{e}].{field}", float(row[column])
            called, counted = (name, unit) if unit is not None else (f"{name}{ending}", gain)
            found.append(_parameter(within + called, place, meaning, counted, start, allowed))
        place, meaning = f"plant.exponent[{e}]", "exponent of the hysteresis in its decay"
        found.append(_parameter(f"{within}exponent", place, meaning, "", exponent(row), "positive"))
    for o in range(len(p.operators)):
        found += _operator_parameters(of, o)
    return found


def _gain(of: PlantUnit) -> tuple[str, str]:
    """How the names of gains of the plant's elements end, and their unit: none where drive and output are volts."""
    return ("", "") if of.element_unit == "V" else ("_rad_v", "rad/V")


def _operator_parameters(of: PlantUnit, o: int) -> list[Variable]:
    p, within, (growth, limit) = of.plant, f"prandtl_ishlinskii[{o + 1}].", of.plant.operator[o, :2]
    *polynomial, reach = of.plant.operator[o, 2:].tolist()
    text, fastest = "growth of the thresholds above 0 with the rate of the drive", "fastest rate that was identified"
    ending, gain = _gain(of)
    begin, end = int(p.play_start[o]), int(p.play_start[o + 1])
    found = [
        _parameter(f"{within}widening_s", f"plant.widening_s[{o}]", text, "s", growth, "not negative"),
        _parameter(f"{within}rate_limit_v_s", f"plant.rate_limit_v_s[{o}]", fastest, "V/s", limit, "positive"),
    ]
    place, text, values = "plant.threshold_v", "thresholds of the plays", p.play_threshold[begin:end].tolist()
    found.append(replace(_array(f"{within}threshold_v", place, text, "V", values, "not negative"), first=begin))
    place, text, values = "plant.weight", "weights of the plays", p.play_weight[begin:end].tolist()
    found.append(replace(_array(f"{within}weight{ending}", place, text, gain, values, "any"), first=begin))
    if math.isfinite(reach):
        name, text = f"{within}polynomial_{of.element_unit.lower()}", "of s^2, |s| s and s^3 beside the plays"
        found.append(_array(name, f"plant.polynomial[{o}]", text, of.element_unit, polynomial, "any"))
        text = "drive where s, the drive over it, is 1; beyond it the polynomial keeps its value"
        found.append(_parameter(f"{within}reach_v", f"plant.reach_v[{o}]", text, "V", reach, "positive"))
    return found


def _constants(unit: PlantUnit | LoopUnit) -> list[Variable]:
    """What a unit was made for and cannot be changed in it."""
    plant, step = plant_of(unit), plant_of(unit).plant.step_s
    found = [
        ("bias_v", "V", plant.bias_v, "bias that commands and drives count from"),
        ("plant_step_s", "s", step, "internal step: a communication step is a multiple of it"),
    ]
    if isinstance(unit, LoopUnit):
        of = unit.controller
        found += [
            ("control_period_s", "s", of.period_s, "period of the controller"),
            ("computation_delay_s", "s", unit.delay_steps * step, "from a control sample to its command"),
            ("command_minimum_v", "V", of.minimum_v, "lowest command, from the bias"),
            ("command_maximum_v", "V", of.maximum_v, "highest command, from the bias"),
        ]
    return [
        Variable(name, f"constants[{i}]", "local", meaning, unit_name, (value,), constant=True)
        for i, (name, unit_name, value, meaning) in enumerate(found)
    ]


def _input(name: str, size: int, text: str, unit: str) -> Variable:
    return Variable(name, name, "input", text, unit, (0.0,) * size, size)


def _output(name: str, size: int, text: str, unit: str, place: str = "") -> Variable:
    """An array; ``place`` is where it stands if not under its ``name``."""
    return Variable(name, place or name, "output", text, unit, None, size)


def _parameter(name: str, place: str, text: str, unit: str, start: float, allowed: Range) -> Variable:
    return Variable(name, place, "parameter", text, unit, (float(start),), range=allowed)


def _array(name: str, place: str, text: str, unit: str, start: Sequence[float], allowed: Range) -> Variable:
    return Variable(name, place, "parameter", text, unit, tuple(map(float, start)), len(start), range=allowed)


def _described(unit: PlantUnit | LoopUnit) -> tuple[str, str]:
    """Name and description of a unit in words, on one line each, of characters that XML can hold."""
    origin = plant_of(unit).origin
    step = f"internal step {plant_of(unit).plant.step_s:g} s"
    if isinstance(unit, LoopUnit):
        name = f"{origin.mirror}, closed loop of {unit.controller.name}"
        what = f"Amplifier, mirror with hysteresis, sensors and controller {unit.controller.name}, {step}"
    else:
        name, what = origin.mirror, f"Amplifier and fast steering mirror with hysteresis, {step}"
    return _line(name), _line(f"{what}. Mission: {origin.mission}, sha256 {origin.mission_sha256}.")


def _line(text: str) -> str:
    return " ".join("".join(c if c.isprintable() else " " for c in text).split())


def model_description(
    unit: PlantUnit | LoopUnit, version: Version, name: str, guid: str, compiled: tuple[str, ...]
) -> str:
    """The text of a unit's modelDescription.xml.

    Args:
        unit: The mirror with its amplifier, or a closed loop.
        version: Version of FMI.
        name: What the unit calls itself, an identifier of C.
        guid: The identifier of its contents, in braces.
        compiled: Names of its C source files, without headers.
    """
    listed = variables(unit, version)
    places = {v.name: i for i, v in enumerate(listed)}
    unknowns = [(i, [places[d] for d in v.dependencies]) for i, v in enumerate(listed) if v.causality == "output"]
    model, text = _described(unit)
    step_s = plant_of(unit).plant.step_s
    return render(
        f"model_description_{version[0]}.xml.j2",
        model=model,
        description=text,
        name=name,
        guid=guid,
        version=version_of("microrad"),
        units=UNITS,
        variables=listed,
        unknowns=unknowns,
        compiled=compiled,
        plant_step_s=step_s,
        step_s=unit.controller.period_s if isinstance(unit, LoopUnit) else step_s,
    )
