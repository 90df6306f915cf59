"""The plan of an experiment as frozen, checked data: limits, the bench, and the excitations to be played.

Every quantity is text with a unit in the file (`duration = "10 s"`) and an SI float with the unit in its name here.
`load_plan` reads the file, checks it against these tables and reports all faults at once.
"""

import difflib
import math
import zlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from importlib import resources
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field, GetCoreSchemaHandler
from pydantic_core import CoreSchema, core_schema

from microrad.core.units import UnitError, format_input, format_limit
from microrad.lab.bench.excitation import (
    DesignError,
    Excitation,
    Limits,
    Lines,
    growing_sines,
    logarithmic_chirp,
    multisine,
    samples_in,
    staircase,
)
from microrad.mission.fields import Problem, Quantity, Several, Table, Whole
from microrad.mission.file import check_table
from microrad.mission.model import Amplifier as AmplifierTable
from microrad.mission.model import AngleOrZero, Duration, Frequencies
from microrad.mission.tables.mirror import Frequency, Name, Rate, Voltage
from microrad.mission.toml import Document, Fault, MissionError, UnreadableError, clipped, shown

FORMATS = ("csv", "lvm", "tdms", "mat", "mat73", "npz", "hdf5")
"""File formats that the bench writes; mat is MATLAB's version 5, mat73 its version 7.3."""
MAT73 = "-v73"
"""What the name of a file of MATLAB's version 7.3 has behind that of the record, beside a version 5 of the same."""


MOST_AXES = 4
"""Axes of a bench; a mirror has two."""


@dataclass(frozen=True, slots=True)
class _Choices(Quantity):
    """A list of distinct formats."""

    def read(self, value: object) -> Any:
        items = value if isinstance(value, list | tuple) else []
        known = all(isinstance(item, str) and item in FORMATS for item in items)
        if not items or not known or len(set(items)) < len(items):
            raise UnitError("formats", "is no list of different file formats", self.wanted, self.example)
        return tuple(items)

    @property
    def wanted(self) -> str:
        return "a list with some of " + ", ".join(FORMATS)

    @property
    def example(self) -> str:
        return '["csv"]'

    def __get_pydantic_core_schema__(self, source: object, handler: GetCoreSchemaHandler) -> CoreSchema:
        return core_schema.no_info_plain_validator_function(self.read)


Count = Annotated[int, Whole("", least=1, most=1_000_000)]
Share = Annotated[float, Quantity("", least=0.0, most=10.0)]
Amplitude = Annotated[float, Quantity("V", "V", above=0.0)]
Amplitudes = Annotated[tuple[float, ...], Several(Quantity("V", above=0.0), rising=True)]


# ------------------------------------------------------------------------------------------------------ the whole bench
class LimitsTable(Table):
    """What every excitation has to keep, in volts before the amplifier; the rate is that of the converters."""

    rate_hz: Frequency = Field(alias="rate", description="sample rate; an excitation may have its own")
    drive_min_v: Voltage = Field(alias="drive_min")
    drive_max_v: Voltage = Field(alias="drive_max")
    slew_v_s: Rate = Field(alias="slew", description="fastest change of the drive between samples")
    samples_per_period: Annotated[float, Quantity("", above=2.0)] = Field(description="at the highest frequency")

    def problems(self) -> Iterator[Problem]:
        """The range must go up."""
        if not self.drive_min_v < self.drive_max_v:
            low = format_input(self.drive_min_v, "V")
            yield Problem("drive_max", f"is not above drive_min ({low})", f"a voltage above {low}")


class ConvertersTable(Table):
    """Converters both ways: `bits` over each range, drive in volts and sensor in angle; both are sampled together."""

    bits: Annotated[int, Whole("", least=4, most=32)]
    drive_min_v: Voltage = Field(alias="drive_min")
    drive_max_v: Voltage = Field(alias="drive_max")
    output_min_rad: Annotated[float, Quantity("rad", "mrad")] = Field(alias="output_min")
    output_max_rad: Annotated[float, Quantity("rad", "mrad")] = Field(alias="output_max")

    def problems(self) -> Iterator[Problem]:
        """The ranges must go up."""
        for name, low, high, unit in (
            ("drive", self.drive_min_v, self.drive_max_v, "V"),
            ("output", self.output_min_rad, self.output_max_rad, "rad"),
        ):
            if not low < high:
                yield Problem(f"{name}_max", f"is not above {name}_min", f"above {format_input(low, unit)}")


class SensorTable(Table):
    """Strain gauge: white noise (absolute rms, or a share of the output's rms about its mean), mains, drift of zero."""

    noise_rad: AngleOrZero | None = Field(None, alias="noise", description="rms of white noise")
    noise_share: Share | None = Field(None, description="rms of white noise over the output's rms about its mean")
    mains_rad: AngleOrZero = Field(alias="mains", description="amplitude of the mains line")
    mains_frequency_hz: Frequency = Field(alias="mains_frequency")
    drift_rad_s: Annotated[float, Quantity("rad/s", "nrad/s")] = Field(alias="drift", description="of the zero")

    def problems(self) -> Iterator[Problem]:
        """Noise must be given once."""
        if (self.noise_rad is None) == (self.noise_share is None):
            found = "are both missing" if self.noise_rad is None else "are both given"
            yield Problem("", f"noise and noise_share {found}", 'one of them: noise = "1 urad" or noise_share = 0.03')


class BenchTable(Table):
    """The virtual bench: which mirror is played, its drives and axes, and what stands before and behind it.

    `truth` is the bench's own mirror, or Eq. 2 ("linear") or Eq. 3 ("bouc-wen") of SPIE 11852, 118523B. Axis i
    moves with drive i, and with `crosstalk` times every other one.
    """

    truth: Literal["bench", "linear", "bouc-wen"]
    axes: Annotated[int, Whole("", least=1, most=MOST_AXES)] = 1
    crosstalk: Annotated[float, Quantity("", least=-0.5, most=0.5)] = 0.0
    amplifier: AmplifierTable
    converters: ConvertersTable
    sensor: SensorTable


# ---------------------------------------------------------------------------------------------------------- excitations
class ExcitationTable(Table):
    """What every excitation may say: what its record is for, and where it differs from the bench."""

    use: Literal["identification", "validation"] = Field(
        "identification", description="validation: held out of every fit"
    )
    rate_hz: Frequency | None = Field(None, alias="rate", description="instead of limits.rate")
    truth: Literal["plan", "bench", "linear", "bouc-wen"] = Field("plan", description="plan: as bench.truth says")
    noise_share: Share | None = Field(None, description="instead of the noise of bench.sensor")

    def design(self, name: str, limits: Limits) -> tuple[Excitation, ...]:
        """The records of this excitation.

        Args:
            name: Name of the excitation, which its records carry.
            limits: What the drive must keep to, and its sample rate.

        Raises:
            DesignError: For an excitation that the limits do not allow.
        """
        raise NotImplementedError

    def parameters(self) -> dict[str, Any]:
        """What the kind has of its own, as the function that designs it takes it; axes count from 0 there."""
        own = {
            name: getattr(self, name) for name in type(self).model_fields if name not in ExcitationTable.model_fields
        }
        del own["kind"]
        return {**own, "axis": own["axis"] - 1} if "axis" in own else own


class ChirpTable(ExcitationTable):
    """Logarithmic chirp of one drive."""

    kind: Literal["chirp"]
    start_hz: Frequency = Field(alias="start")
    stop_hz: Frequency = Field(alias="stop")
    duration_s: Duration = Field(alias="duration")
    amplitude_v: Amplitude = Field(alias="amplitude")
    offset_v: Voltage = Field(alias="offset")
    axis: Count = 1

    def design(self, name: str, limits: Limits) -> tuple[Excitation, ...]:
        """The one record of this excitation.

        Args:
            name: Name of the record.
            limits: What the drive must keep to, and its sample rate.

        Raises:
            DesignError: For an excitation that the limits do not allow.
        """
        return (logarithmic_chirp(limits, **self.parameters(), name=name),)


class MultisineTable(ExcitationTable):
    """Random-phase multisines, orthogonal where the bench has several axes; `seed` is that of the phases."""

    kind: Literal["multisine"]
    lines: Literal["all", "odd", "odd-random"]
    start_hz: Frequency = Field(alias="start")
    stop_hz: Frequency = Field(alias="stop")
    period_s: Duration = Field(alias="period")
    rms_v: Amplitude = Field(alias="rms", description="of each drive about the offset")
    offset_v: Voltage = Field(alias="offset")
    periods: Count
    realisations: Count
    seed: Annotated[int, Whole("", least=0, most=2**63 - 1)]

    def design(self, name: str, limits: Limits) -> tuple[Excitation, ...]:
        """The records of this excitation, one for each realisation.

        Args:
            name: Name of the excitation, which its records carry.
            limits: What the drive must keep to, and its sample rate.

        Raises:
            DesignError: For an excitation that the limits do not allow.
        """
        parameters = self.parameters()
        lines = Lines(*(parameters.pop(key) for key in ("period_s", "start_hz", "stop_hz", "lines")))
        return multisine(limits, lines, **parameters, name=name)


class SinesTable(ExcitationTable):
    """Sines of one or more rising amplitudes, one record for each frequency."""

    kind: Literal["sines"]
    frequencies_hz: Frequencies = Field(alias="frequencies")
    amplitudes_v: Amplitudes = Field(alias="amplitudes")
    periods: Count = Field(description="at each amplitude")
    offset_v: Voltage = Field(alias="offset")
    axis: Count = 1

    def design(self, name: str, limits: Limits) -> tuple[Excitation, ...]:
        """The records of this excitation, one for each frequency and named with it where there are several.

        Args:
            name: Name of the excitation, with which those of its records begin.
            limits: What the drive must keep to, and its sample rate.

        Raises:
            DesignError: For an excitation that the limits do not allow.
        """
        parameters = self.parameters()
        frequencies_hz = parameters.pop("frequencies_hz")
        seconds = self.periods * len(self.amplitudes_v) * math.fsum(1.0 / f for f in frequencies_hz)
        samples_in(limits, name, "frequencies", seconds)
        names = [f"{name}-{f:g}hz" for f in frequencies_hz] if len(frequencies_hz) > 1 else [name]
        return tuple(
            growing_sines(limits, **parameters, freq_hz=freq_hz, name=each)
            for freq_hz, each in zip(frequencies_hz, names, strict=True)
        )


class StaircaseTable(ExcitationTable):
    """Steps between levels, held for creep to show."""

    kind: Literal["staircase"]
    levels_v: Annotated[tuple[float, ...], Several(Quantity("V"))] = Field(alias="levels")
    dwell_s: Duration = Field(alias="dwell", description="time at each level")
    rise_s: Duration = Field(alias="rise", description="time from one level to the next")
    axis: Count = 1

    def design(self, name: str, limits: Limits) -> tuple[Excitation, ...]:
        """The one record of this excitation.

        Args:
            name: Name of the record.
            limits: What the drive must keep to, and its sample rate.

        Raises:
            DesignError: For an excitation that the limits do not allow.
        """
        return (staircase(limits, **self.parameters(), name=name),)


KINDS: dict[str, type[ExcitationTable]] = {
    "chirp": ChirpTable,
    "multisine": MultisineTable,
    "sines": SinesTable,
    "staircase": StaircaseTable,
}
"""The kinds of excitation by the word that a plan calls them."""


# ------------------------------------------------------------------------------------------------------------- the plan
class PlanTable(Table):
    """The root of a plan file; each table of `excitation` is checked against its own kind."""

    name: Name
    formats: Annotated[tuple[str, ...], _Choices("")]
    limits: LimitsTable
    bench: BenchTable
    excitation: dict[str, Any] = Field(description="tables [excitation.NAME], each with its kind")

    def problems(self) -> Iterator[Problem]:
        """Converters and amplifier must be able to follow the drives."""
        limits, converters, amplifier = self.limits, self.bench.converters, self.bench.amplifier
        ranges = (
            ("the converters", converters.drive_min_v, converters.drive_max_v),
            ("the amplifier", amplifier.output_min_v / amplifier.gain, amplifier.output_max_v / amplifier.gain),
        )
        for what, low, high in ranges:
            span = f"{format_limit(low, 'V', least=True)} to {format_limit(high, 'V')}"
            if limits.drive_min_v < low:
                yield Problem(
                    "limits.drive_min", f"is below the range of {what}, {span} at the drive", f"within {span}"
                )
            if limits.drive_max_v > high:
                yield Problem(
                    "limits.drive_max", f"is above the range of {what}, {span} at the drive", f"within {span}"
                )


@dataclass(frozen=True, slots=True)
class Record:
    """One record of a plan: its excitation, what it is for, the mirror that answers, and the noise on its output.

    `noise_share` replaces the noise of the bench's sensor where it is not None. `kind` is that of the excitation.
    """

    excitation: Excitation
    kind: str
    use: str
    truth: str
    noise_share: float | None

    @property
    def stream(self) -> int:
        """What tells the random numbers of this record from those of another one: a checksum of its name."""
        return zlib.crc32(self.excitation.name.encode())


@dataclass(frozen=True, slots=True)
class Plan:
    """A plan that keeps its limits, with its designed records in the order of the file, and path, text and SHA-256."""

    name: str
    formats: tuple[str, ...]
    limits: LimitsTable
    bench: BenchTable
    records: tuple[Record, ...]
    path: Path
    text: str
    sha256: str


def select_records(plan: Plan, names: Sequence[str]) -> Plan:
    """The plan cut down to some of its records; their noise stays the same.

    Args:
        plan: The whole plan.
        names: Names of the records to keep.

    Raises:
        ValueError: For a name that the plan does not have.
    """
    known = [record.excitation.name for record in plan.records]
    for name in names:
        if name not in known:
            raise ValueError(f"{plan.path}: no record is named '{name}'; the plan has {', '.join(known)}.")
    return replace(plan, records=tuple(r for r in plan.records if r.excitation.name in names))


_NAME = set("abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789-_")
_MOST_EXCITATIONS = 200
_MOST_SAMPLES = 50_000_000  # of all records together, 400 MB


class PlanError(MissionError):
    """A plan file that cannot be used: `path`, and every fault found in `faults`, by line."""


def packaged_plans() -> tuple[str, ...]:
    """Names of the plans that come with the package; `load_plan` takes them."""
    files = resources.files("microrad.lab").joinpath("plans").iterdir()
    return tuple(sorted(Path(file.name).stem for file in files if file.name.endswith(".toml")))


def load_plan(path: str | Path) -> Plan:
    """Read a plan file, or a packaged plan by its name where no such file exists, and design its excitations.

    Raises PlanError with every fault: what is no TOML, an unknown key, no quantity, an excitation that leaves a limit.
    """
    if not Path(path).exists() and str(path) in packaged_plans():
        with resources.as_file(resources.files("microrad.lab") / "plans" / f"{path}.toml") as packaged:
            return _load(packaged)
    return _load(Path(path))


def _load(path: Path) -> Plan:
    try:
        document = Document.read(path, "plan file")
    except UnreadableError as error:
        expected = error.expected if path.exists() else f"a plan file, or one of {', '.join(packaged_plans())}"
        fault = Fault("", "", 0, f"the plan file {error.reason}", expected, file=clipped(str(path)))
        raise PlanError(path, [fault]) from None
    except MissionError as error:
        raise PlanError(path, error.faults) from None
    tables = _excitation_tables(document)
    root = check_table(document, PlanTable, document.data)
    excitations = {name: _excitation(document, name, table) for name, table in tables.items()}
    truth = "" if root is None else root.bench.truth
    records = _records(document, excitations, _frame(document, root), truth)
    if root is None or document.faults:
        raise PlanError(path, document.faults)
    return Plan(root.name, root.formats, root.limits, root.bench, records, path, document.text, document.sha256)


def _excitation_tables(document: Document) -> dict[str, object]:
    """The tables [excitation.NAME]; anything else under that name is noted, and what is left can be checked."""
    found = document.data.get("excitation")
    expected = "a table [excitation.NAME] for each, NAME of letters, digits, - and _"
    if not isinstance(found, dict) or not found:
        if "excitation" not in document.damaged and not any(d.startswith("excitation.") for d in document.damaged):
            reason = "is missing" if found is None else "is not a group of named tables"
            document.fault("excitation", "", reason, expected)
        document.data["excitation"] = {}
        return {}
    if len(found) > _MOST_EXCITATIONS:
        document.fault("excitation", "", f"has {len(found)} tables", f"at most {_MOST_EXCITATIONS}")
        return {}
    for name in [name for name in found if not name or not set(name) <= _NAME or len(name) > 60]:
        document.fault(f"excitation.{name}", "", "is no name that a file can have", expected)
    return dict(found)


def _excitation(document: Document, name: str, table: object) -> ExcitationTable | None:
    """One excitation, or None with every fault in it noted."""
    key = f"excitation.{name}"
    if not isinstance(table, dict):
        document.fault(key, shown(table), "is no table", f"[{key}] with a kind and its parameters")
        return None
    kind = table.get("kind")
    if not isinstance(kind, str) or kind not in KINDS:
        if f"{key}.kind" not in document.damaged:
            choices = " or ".join(f'kind = "{each}"' for each in KINDS)
            near = next(iter(difflib.get_close_matches(str(kind)[:60], KINDS, n=1)), "")
            reason = "is missing" if kind is None else "is none of the choices"
            value = "" if kind is None else shown(kind)
            document.fault(f"{key}.kind", value, reason, choices, nearest=near and f'"{near}"')
        return None
    return check_table(replace(document, prefix=key), KINDS[kind], table)


def _frame(document: Document, root: PlanTable | None) -> tuple[LimitsTable, int] | None:
    """Limits and number of axes where they are in order, also when something else in the file is not."""
    if root is not None:
        return root.limits, root.bench.axes
    silent = replace(document, faults=[], prefix="limits")  # what is wrong with them has been said
    limits = check_table(silent, LimitsTable, document.data.get("limits", {}))
    bench = document.data.get("bench", {})
    axes = bench.get("axes", 1) if isinstance(bench, dict) else 1
    return (limits, axes) if limits is not None and axes in range(1, MOST_AXES + 1) else None


def _records(
    document: Document, tables: dict[str, ExcitationTable | None], frame: tuple[LimitsTable, int] | None, truth: str
) -> tuple[Record, ...]:
    """Every record of every excitation that can be designed; the others are noted. `truth` is that of the bench."""
    if frame is None:
        return ()
    records: list[Record] = []
    left = _MOST_SAMPLES
    for name, table in tables.items():
        if table is None:
            continue
        try:
            rate_hz = table.rate_hz or frame[0].rate_hz
            designs = table.design(name, Limits(**{**dict(frame[0]), "rate_hz": rate_hz}, inputs=frame[1]))
        except DesignError as error:
            _note(document, name, error)
            continue
        left -= sum(design.drive.size for design in designs)
        if left < 0:
            reason = f"makes a plan of more than {_MOST_SAMPLES / 1e6:g} million samples"
            document.fault(f"excitation.{name}", "", reason, "shorter records, or two plans")
            return ()
        kind = document.data["excitation"][name]["kind"]
        played = truth if table.truth == "plan" else table.truth
        records += [Record(design, kind, table.use, played, table.noise_share) for design in designs]
    _note_same_names(document, [record.excitation.name for record in records])
    return tuple(records)


def _note(document: Document, name: str, error: DesignError) -> None:
    for problem in error.problems:
        key = f"excitation.{name}.{problem.key}"
        found = document.statements.get(key)
        document.fault(key, clipped(found.value) if found else "", problem.reason, problem.expected)


def _note_same_names(document: Document, names: Sequence[str]) -> None:
    seen: set[str] = set()
    for name in names:
        if name.lower() in seen:
            document.fault("excitation", "", f'makes two records named "{name}"', "names that stay different")
        seen.add(name.lower())
    formats = document.data.get("formats")
    for name in names if isinstance(formats, list) and "mat" in formats and "mat73" in formats else ():
        if name.lower() + MAT73 in seen:
            reason = f'writes two records to "{name}{MAT73}.mat", as mat and as mat73'
            document.fault("excitation", "", reason, "names that stay different, or one of the two formats")
