"""What every format delivers: named channels, their units, the rates that the file states, and values on demand."""

import difflib
import re
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from microrad.core.arrays import Floats
from microrad.lab.recording.records import RecordingError

_TIME_NAME = re.compile(
    r"(?i:time|zeit|temps|tiempo|x_value|time_?stamp|seconds|sec|(?-i:t))(_?(s|ms|us|ns))?\s*([(\[].*[)\]])?"
)
_BRACKETED = re.compile(r"[(\[]\s*([^()\[\]]*?)\s*[)\]]\s*$")
_COLUMN = re.compile(r"\[[\d, ]*\]$")
SECONDS = {"s": 1.0, "sec": 1.0, "seconds": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6, "μs": 1e-6, "ns": 1e-9}


@dataclass(frozen=True)
class StatedRate:
    """A sample rate that the file states, with the words that state it."""

    rate_hz: float
    words: str


def bracketed_unit(name: str) -> str:
    """The unit in the brackets of a name, `V` of `Voltage (V)` or `Voltage [V]`, else nothing."""
    match = _BRACKETED.search(name)
    return match.group(1) if match else ""


def is_time_name(name: str) -> bool:
    """Whether the last part of a channel's name is one that plainly means time."""
    return _TIME_NAME.fullmatch(name.rsplit("/", 1)[-1].strip()) is not None


def time_unit(name: str, unit: str) -> str:
    """Unit of a time channel: the one stated, else the one in its name, in brackets or behind an underscore, else s.

    Args:
        name: Name of the channel.
        unit: Unit that the file states, empty for none.
    """
    tail = name.rsplit("_", 1)[-1].casefold() if "_" in name else ""
    stated = unit or bracketed_unit(name) or (tail if tail in SECONDS else "")
    return stated or "s"


class Source(ABC):
    """An opened file: `names` and `units` are those of its channels, in order; '' where there is none."""

    path: Path
    names: tuple[str, ...]
    units: tuple[str, ...]
    sha256: str

    @abstractmethod
    def label(self, index: int) -> str:
        """The channel in the words of a message."""

    @abstractmethod
    def resolve(self, wanted: int | str, role: str) -> int:
        """Number of the channel with a name or a number.

        Args:
            wanted: Name of the channel, or its number from 0.
            role: What the channel is wanted for, in the words of a message.

        Raises:
            RecordingError: For no such channel, or a name that may be several.
        """

    @abstractmethod
    def load(self, indices: Sequence[int]) -> list[Floats]:
        """Values of channels, one-dimensional; those of an array container may hold nan."""

    @abstractmethod
    def rates(self, indices: Sequence[int]) -> list[StatedRate]:
        """The sample rates that the file states for these channels."""

    def samples(self) -> tuple[int | None, ...]:
        """How many each channel has; None where that is known once they are read."""
        return (None,) * len(self.names)

    def place(self, row: int) -> str:
        """Where a sample stands in the file, in the words of a message."""
        return f"sample {row}"

    def find_time(self, used: Sequence[int]) -> int | None:
        """The first channel that is plainly time and not in use."""
        for index, name in enumerate(self.names):
            if index not in used and is_time_name(name):
                return index
        return None


@dataclass(frozen=True, eq=False)
class Channel:
    """One channel of an array container, with the function that loads its values."""

    name: str
    samples: int
    load: Callable[[], Floats]
    unit: str = ""
    rate: StatedRate | None = None


@dataclass(eq=False)
class Container(Source):
    """Channels of a binary file, by name, by the last part of the name where that is unique, or by number.

    `unusable` says of other variables why they are no channel. `stated` are rates that hold for a group ('' for the
    whole file), by the group's name.
    """

    path: Path
    kind: str
    channels: tuple[Channel, ...]
    sha256: str
    unusable: Mapping[str, str] = field(default_factory=dict)
    stated: Mapping[str, tuple[StatedRate, ...]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Take names and units from the channels; raises `RecordingError` for a file without any."""
        self.names = tuple(channel.name for channel in self.channels)
        self.units = tuple(channel.unit for channel in self.channels)
        if not self.channels and not self._has_more():
            reasons = "; ".join(f"'{name}' {reason}" for name, reason in list(self.unusable.items())[:5])
            raise RecordingError(
                f"{self.path}: the {self.kind} file holds no channel of numbers"
                f"{f' ({reasons})' if reasons else ''}; record again or name another file."
            )

    def samples(self) -> tuple[int | None, ...]:
        """How many samples each channel states to have."""
        return tuple(channel.samples for channel in self.channels)

    def _has_more(self) -> bool:
        """Whether names beyond those of the listed channels may be resolved."""
        return False

    def label(self, index: int) -> str:
        """The channel in the words of a message, such as `channel 1 ('bench/y')`."""
        return f"channel {index} ('{self.names[index]}')"

    def resolve(self, wanted: int | str, role: str) -> int:
        """Number of the channel with a full name, the unique last part of one, or a number.

        Args:
            wanted: Name of the channel, or its number from 0.
            role: What the channel is wanted for, in the words of a message.

        Raises:
            RecordingError: For no such channel, or a name that may be several.
        """
        if isinstance(wanted, str):
            hits = [i for i, name in enumerate(self.names) if name == wanted]
            hits = hits or [i for i, name in enumerate(self.names) if name.rsplit("/", 1)[-1] == wanted]
            if len(hits) == 1:
                return hits[0]
            if hits:
                full = ", ".join(f"'{self.names[i]}'" for i in hits[:10])
                raise RecordingError(f"{self.path}: '{wanted}' may be {full}; give the {role} by its full name.")
        try:
            number = int(wanted)
        except ValueError:
            raise RecordingError(self._unknown(str(wanted), role)) from None
        if isinstance(wanted, bool) or not 0 <= number < len(self.names):
            raise RecordingError(
                f"{self.path}: there is no {role} channel {wanted}: the {self.kind} file has {len(self.names)} "
                f"channels, numbered from 0 ({self._list()})."
            )
        return number

    def _list(self) -> str:
        more = f" and {len(self.names) - 20} more" if len(self.names) > 20 else ""
        if not self.names:
            return "; ".join(f"'{name}' {reason}" for name, reason in list(self.unusable.items())[:5])
        return ", ".join(f"'{name}'" for name in self.names[:20]) + more

    def _unknown(self, wanted: str, role: str) -> str:
        variable = wanted.partition("[")[0]
        for name in (wanted, variable):
            full = next((n for n in self.unusable if name in (n, n.rsplit("/", 1)[-1])), None)
            if full is not None:
                return f"{self.path}: the {role} '{wanted}' is no channel: '{full}' {self.unusable[full]}."
        folded = {name.casefold(): name for name in self.names}
        near = difflib.get_close_matches(wanted.casefold(), folded, n=1, cutoff=0.0)
        nearest = f"the nearest is '{folded[near[0]]}'. " if near else ""
        return (
            f"{self.path}: no {role} channel is named '{wanted}'; {nearest}The channels are {self._list()}; a number "
            "counted from 0 does as well."
        )

    def load(self, indices: Sequence[int]) -> list[Floats]:
        """Load channels; raises `RecordingError` for a fault of the file that shows only now."""
        return [self.loaded(self.label(index), self.channels[index].load) for index in indices]

    def loaded(self, label: str, load: Callable[[], Floats]) -> Floats:
        """What a function loads from the file.

        Args:
            label: What it loads, in the words of a message.
            load: The function.

        Raises:
            RecordingError: For a fault of the file that shows only now.
        """
        try:
            return load()
        except RecordingError:
            raise
        except MemoryError:
            raise RecordingError(
                f"{self.path}: {label} takes more memory than there is to read; cut out the part that you need, or "
                "keep every n-th sample."
            ) from None
        except Exception as error:  # a damaged file may raise anything in its library
            raise RecordingError(
                f"{self.path}: {label} cannot be read ({_first_line(error)}); the file is damaged or truncated: copy "
                "it again from its source."
            ) from None

    def find_time(self, used: Sequence[int]) -> int | None:
        """The first channel that is plainly time and as long as the first one in use."""
        for index, channel in enumerate(self.channels):
            if index not in used and is_time_name(channel.name) and channel.samples == self.channels[used[0]].samples:
                return index
        return None

    def rates(self, indices: Sequence[int]) -> list[StatedRate]:
        """Rates of the channels, else of the nearest of the variable and the groups around it that states one."""
        found: list[StatedRate] = []
        for channel in (self.channels[index] for index in indices):
            found.extend([channel.rate] if channel.rate else self.rates_of(channel.name))
        return list(dict.fromkeys(found))

    def rates_of(self, name: str) -> tuple[StatedRate, ...]:
        """Rates of the nearest of a variable and the groups around it that states one; of one column or of it all."""
        group = name if name in self.stated else _COLUMN.sub("", name)
        while group and group not in self.stated:
            group = group.rpartition("/")[0]
        return self.stated.get(group, ())


def _first_line(error: BaseException) -> str:
    lines = str(error).splitlines()
    return lines[0] if lines else type(error).__name__


def damaged(path: Path, kind: str, error: BaseException) -> RecordingError:
    """The refusal of a file that its library cannot open.

    Args:
        path: The file.
        kind: Its format in the words of a message.
        error: What the library raised.
    """
    return RecordingError(
        f"{path}: this cannot be read as {kind} ({_first_line(error)}); the file is damaged or truncated: copy it "
        "again from its source."
    )
