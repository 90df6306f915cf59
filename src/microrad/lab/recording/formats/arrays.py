"""Variables of array files (NumPy, MATLAB, HDF5) as channels, and scalars that state the sample rate."""

import math
import re
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from microrad.core.arrays import Floats
from microrad.lab.recording.files import too_large
from microrad.lab.recording.formats.source import Channel, Container, StatedRate
from microrad.lab.recording.records import RecordingError

# fmt: off
RATE_NAMES = frozenset({
    "fs", "f_s", "fs_hz", "rate", "rate_hz", "sample_rate", "sample_rate_hz", "samplerate", "sampling_rate",
    "sampling_rate_hz", "samplingrate", "sampling_frequency", "sample_frequency", "samplefrequency", "fsample",
})
STEP_NAMES = frozenset({
    "dt", "dt_s", "ts", "t_s", "tsample", "delta_t", "deltat", "step_s", "sample_time", "sampling_time",
    "sample_period", "sampling_period", "sample_interval", "sampling_interval", "wf_increment",
})
# fmt: on
UNIT_NAMES = ("units", "unit", "unit_string")
_MOST_COLUMNS = 10_000  # a few bytes may claim millions
_INDEXED = re.compile(r"(.*)\[\s*(\d{1,9}(?:\s*,\s*\d{1,9})*)\s*\]")


@dataclass(frozen=True, eq=False)
class Variable:
    """One array of a file: its shape, NumPy kind of its type, and functions that load one channel, or it all."""

    name: str
    shape: tuple[int, ...]
    dtype: np.dtype[Any]
    load: Callable[[tuple[int | slice, ...]], Any]
    unit: str = ""


def stated_rate(name: str, value: Any) -> StatedRate | None:
    """The sample rate that a scalar with a name such as fs or dt states; None for any other variable.

    Args:
        name: Name of the variable, after that of its group.
        value: Its value, in Hz or, where the name is that of a step, in s.
    """
    key = name.rsplit("/", 1)[-1].casefold()
    if key not in RATE_NAMES | STEP_NAMES:
        return None
    try:
        number = float(np.asarray(value).reshape(-1)[0]) if np.size(value) == 1 else math.nan
    except (TypeError, ValueError):
        return None
    if not (0 < number < math.inf and 0 < 1 / number < math.inf):
        return None
    if key in RATE_NAMES:
        return StatedRate(number, f"{name} = {number:g} Hz")
    return StatedRate(1 / number, f"{name} = {number:g} s")


def rates_of(variables: list[Variable]) -> dict[str, tuple[StatedRate, ...]]:
    """The rates that scalars state, by the group that they stand in ('' for the file)."""
    found: dict[str, tuple[StatedRate, ...]] = {}
    for variable in variables:
        scalar = variable.dtype.kind in "iuf" and all(n == 1 for n in variable.shape)
        if scalar and (rate := stated_rate(variable.name, variable.load((0,) * len(variable.shape)))):
            group = variable.name.rpartition("/")[0]
            found[group] = (*found.get(group, ()), rate)
    return found


def channels_of(variables: list[Variable], unusable: dict[str, str]) -> tuple[Channel, ...]:
    """The channels in some variables: each vector is one, and each column of a matrix, named `variable[column]`.

    Samples run along the longer axis. Arrays of more axes are not listed: `ArraySource.resolve` takes them by index.

    Args:
        variables: The variables of the file.
        unusable: Why other variables are no channels, by their names; those found here are added.
    """
    found: list[Channel] = []
    for variable in variables:
        shape = tuple(n for n in variable.shape if n != 1)
        if variable.dtype.kind not in "iuf":
            unusable[variable.name] = f"holds {_type_words(variable.dtype)}"
        elif math.prod(variable.shape) == 0:
            unusable[variable.name] = "holds no samples; record again, or name another"
        elif len(shape) == 0:
            unusable[variable.name] = "is a single number; name an array"
        elif len(shape) == 1:
            found.append(_channel(variable, ()))
        elif len(shape) == 2 and min(shape) > _MOST_COLUMNS:
            unusable[variable.name] = (
                f"is an array of shape {variable.shape}: at most {_MOST_COLUMNS} channels are listed; save the columns "
                "that you need"
            )
        elif len(shape) == 2:
            found.extend(_channel(variable, (column,)) for column in range(min(shape)))
        else:
            unusable[variable.name] = many_axes(variable)
    return tuple(found)


def many_axes(variable: Variable) -> str:
    """What to do with an array of three axes or more."""
    axis = sample_axis(variable.shape)
    others = [n for k, n in enumerate(variable.shape) if k != axis]
    example = ", ".join("0" for _ in others)
    return (
        f"is an array of shape {variable.shape}: name one channel of it with an index for each axis but the samples', "
        f"'{variable.name}[{example}]', or read it whole by saying what each axis is: --axes (axes), such as "
        "samples,channels,realisations,periods"
    )


def sample_axis(shape: tuple[int, ...]) -> int:
    """The longest axis, the first of equals."""
    return int(np.argmax(shape))


def _channel(variable: Variable, index: tuple[int, ...]) -> Channel:
    """`index` counts along the axes that are neither the samples' nor of length one."""
    axis = sample_axis(variable.shape)
    wide = [k for k, n in enumerate(variable.shape) if k != axis and n != 1]
    key: list[int | slice] = [0] * len(variable.shape)
    key[axis] = slice(None)
    for k, i in zip(wide, index, strict=True):
        key[k] = i

    def load() -> Floats:
        with np.errstate(invalid="ignore"):  # a signalling NaN becomes a quiet one, and is found as such
            return np.ascontiguousarray(variable.load(tuple(key)), dtype=np.float64).reshape(-1)

    name = f"{variable.name}[{', '.join(map(str, index))}]" if index else variable.name
    return Channel(name, variable.shape[axis], load, variable.unit)


def indexed(source: Container, variables: list[Variable], wanted: int | str) -> Channel | None:
    """The channel that `variable[i, j, ...]` names in an array of three axes or more, if it exists.

    Args:
        source: The container, whose variables they are.
        variables: Its variables.
        wanted: Name of the channel; a number names none.
    """
    match = _INDEXED.fullmatch(wanted) if isinstance(wanted, str) else None
    if match is None:
        return None
    index = tuple(int(part) for part in match.group(2).split(","))
    for variable in variables:
        if variable.name != match.group(1) and variable.name.rsplit("/", 1)[-1] != match.group(1):
            continue
        axis = sample_axis(variable.shape)
        others = [n for k, n in enumerate(variable.shape) if k != axis]
        wide = [(n, i) for n, i in zip(others, index, strict=False) if n != 1]
        fits = len(index) == len(others) and all(i < n for n, i in zip(others, index, strict=True))
        if fits and len(others) >= 2 and variable.dtype.kind in "iuf":
            channel = _channel(variable, tuple(i for _, i in wide))
            return replace(channel, name=f"{variable.name}[{', '.join(map(str, index))}]")
    return None


def _type_words(dtype: np.dtype[Any]) -> str:
    if dtype.names and dtype.names != ("real", "imag"):  # the latter is MATLAB's complex number in HDF5
        return f"records of {', '.join(dtype.names[:5])}; save each of these as an array of its own"
    words = {
        "c": "complex numbers, not real numbers; save the real signal",
        "b": "booleans, not real numbers; save numbers, or name another",
        "S": "text, not real numbers; save numbers, or name another",
        "U": "text, not real numbers; save numbers, or name another",
    }
    return words.get(
        "c" if dtype.names else dtype.kind, f"the type {dtype}, not real numbers; save it as floating-point numbers"
    )


class ArraySource(Container):
    """A container of variables, which also takes one channel out of an array with many axes."""

    variables: list[Variable]

    def _has_more(self) -> bool:
        return any(sum(n != 1 for n in v.shape) > 2 and v.dtype.kind in "iuf" for v in self.variables)

    def resolve(self, wanted: int | str, role: str) -> int:
        """Number of a channel; one that an index picks out of an array joins the list of channels.

        Args:
            wanted: A name, a number, or `variable[i, j, ...]`.
            role: What the channel is wanted for, in the words of a message.

        Raises:
            RecordingError: For no such channel, or a name that may be several.
        """
        if isinstance(wanted, str) and wanted not in self.names:
            wanted = re.sub(r"\s*,\s*", ", ", wanted)
            extra = indexed(self, self.variables, wanted)
            if extra is not None:
                wanted = extra.name
                if wanted not in self.names:
                    self.channels = (*self.channels, extra)
                    self.names, self.units = (*self.names, extra.name), (*self.units, extra.unit)
        return super().resolve(wanted, role)

    def whole(self, wanted: str | None, axes: int, role: str) -> Variable:
        """An array that is read with all its axes, in the shape that has as many of them.

        Args:
            wanted: Its name, or the last part of it; None for the only array with so many axes.
            axes: How many axes it is to have; others must be of length one.
            role: What it is wanted for, in the words of a message.

        Raises:
            RecordingError: For no such array, one of other axes, and one that is too large.
        """
        numbers = [v for v in self.variables if v.dtype.kind in "iuf" and math.prod(v.shape) > 1]
        alone = wanted is None and len(numbers) == 1
        named = numbers if alone else [v for v in numbers if wanted in (v.name, v.name.rsplit("/", 1)[-1])]
        fitting = [v for v in (numbers if wanted is None else named) if _with_axes(v.shape, axes) is not None]
        listed = ", ".join(f"'{v.name}' of shape {v.shape}" for v in numbers[:20]) or self._list()
        if len(fitting) == 1:
            shape = _with_axes(fitting[0].shape, axes) or ()
            if reason := too_large(self.path, shape, 8):
                raise RecordingError(f"{self.path}: '{fitting[0].name}' {reason}.")
            return replace(fitting[0], shape=shape)
        if named and not fitting:
            raise RecordingError(
                f"{self.path}: the {role} '{named[0].name}' has the shape {named[0].shape} and --axes (axes) names "
                f"{axes}; name each axis of the array once, in its order."
            )
        if wanted is None:
            some = f"{len(fitting)} arrays have" if fitting else "no array has"
            raise RecordingError(
                f"{self.path}: {some} {axes} axes, as --axes (axes) says, so which one holds the {role}s is not plain: "
                f"name it (--{role}). The file holds {listed}."
            )
        raise RecordingError(f"{self.path}: no one array of {role}s is named '{wanted}'; the file holds {listed}.")

    def load_whole(self, variable: Variable) -> Floats:
        """All numbers of an array that `whole` gave; raises `RecordingError` where they cannot be read."""

        def load() -> Floats:
            with np.errstate(invalid="ignore"):  # a signalling NaN becomes a quiet one, and is found as such
                every = (slice(None),) * next(len(v.shape) for v in self.variables if v.name == variable.name)
                return np.asarray(variable.load(every), dtype=np.float64).reshape(variable.shape)

        return self.loaded(f"'{variable.name}'", load)


def _with_axes(shape: tuple[int, ...], axes: int) -> tuple[int, ...] | None:
    """The shape with so many axes, as it is or without those of length one; None where neither has so many."""
    long = tuple(n for n in shape if n != 1)
    return next((each for each in (shape, long) if len(each) == axes), None)
