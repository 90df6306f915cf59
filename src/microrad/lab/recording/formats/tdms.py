"""LabVIEW TDMS files: the chain of segments is walked before any number is believed.

The lead-in of a segment is described in National Instruments' "TDMS File Format Internal Structure".
"""

import logging
import re
import struct
import threading
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from microrad.core.arrays import Floats
from microrad.core.installing import advice
from microrad.lab.recording.files import sha256_of
from microrad.lab.recording.formats.source import Channel, Container, StatedRate, damaged
from microrad.lab.recording.records import RecordingError

_LEAD_IN = 28
_INCOMPLETE = 0xFFFF_FFFF_FFFF_FFFF
_VERSIONS = (4712, 4713)
_BIG_ENDIAN = 1 << 6
_SCALE = re.compile(r"NI_Scale\[(\d{1,18})\]")
_MOST_SCALES = 1000  # of a channel
_OF_NUMBERS = ("Cropping data", "Unsupported scale type")


class TdmsSource(Container):
    """A TDMS file; channels are named `group/channel`, and time follows from their increments."""

    def __init__(self, path: Path) -> None:
        """Check the structure, then read the metadata."""
        check_structure(path)
        try:
            import nptdms  # noqa: F401
        except ImportError:
            raise RecordingError(
                f"{path}: reading a TDMS file needs the library npTDMS, which is not installed; install it "
                f"{advice('lab')}"
            ) from None
        unusable: dict[str, str] = {}
        try:
            with _opened(path) as tdms:
                raw = dict(_channels(tdms, unusable))
                channels = tuple(_channel(path, name, channel) for name, channel in raw.items())
                self._starts = {name: _start(channel) for name, channel in raw.items()}
        except RecordingError:
            raise
        except Exception as error:  # the library raises whatever its parser stumbles over
            raise damaged(path, "a TDMS file", error) from None
        super().__init__(path, "TDMS", channels, sha256_of(path), unusable)

    def load(self, indices: Sequence[int]) -> list[Floats]:
        """Scaled values of the channels; raises `RecordingError` for channels that were not sampled together."""
        self._check_together(indices)
        return super().load(indices)

    def _check_together(self, indices: Sequence[int]) -> None:
        steps = [1 / rate.rate_hz for i in indices if (rate := self.channels[i].rate)]
        starts = {self.names[i]: start for i in indices if (start := self._starts[self.names[i]])}
        if len(starts) < 2 or not steps:
            return
        begin = next(iter(starts.values()))[0]
        times = {name: float((at - begin) / np.timedelta64(1, "ns")) * 1e-9 + off for name, (at, off) in starts.items()}
        first, last = (choose(times, key=times.__getitem__) for choose in (min, max))
        apart = times[last] - times[first]
        if apart > 0.5 * min(steps) + 1e-6:  # times are kept to a microsecond
            raise RecordingError(
                f"{self.path}: '{last}' starts {apart:.6g} s apart from '{first}' (wf_start_time, wf_start_offset; one "
                f"step is {min(steps):.6g} s); record both in one task, or cut them to their common time."
            )


class _Listener(logging.Handler):
    """Keeps what the library warns of in this thread, where it says that numbers are not as they were recorded."""

    def __init__(self) -> None:
        super().__init__()
        self.thread = threading.get_ident()
        self.heard: list[str] = []

    def emit(self, record: logging.LogRecord) -> None:
        """Take in a warning; those of names and versions change no number."""
        if record.thread == self.thread and str(record.msg).startswith(_OF_NUMBERS):
            self.heard.append(record.getMessage())


@contextmanager
def _opened(path: Path) -> Iterator[Any]:
    """The file, opened: given its path, the library would believe an old .tdms_index beside it.

    The warnings of the library are not printed. Raises RecordingError at the end if one says that numbers are in doubt.
    """
    from nptdms import TdmsFile
    from nptdms.log import log_manager

    log_manager.console_handler.setLevel(logging.CRITICAL)
    library, listener = logging.getLogger("nptdms"), _Listener()
    library.addHandler(listener)
    try:
        with path.open("rb") as file, TdmsFile.open(file) as tdms, np.errstate(all="ignore"):
            yield tdms
    finally:
        library.removeHandler(listener)
    if listener.heard:
        raise RecordingError(
            f"{path}: the numbers of the TDMS file are not as they were recorded ({listener.heard[0]}); save it again "
            "from LabVIEW with scaled numbers, or export it as text."
        )


def _start(channel: Any) -> tuple[np.datetime64, float] | None:
    start = channel.properties.get("wf_start_time")
    offset = float(channel.properties.get("wf_start_offset", 0.0))
    return (start, offset) if isinstance(start, np.datetime64) else None


def _channels(tdms: Any, unusable: dict[str, str]) -> Iterator[tuple[str, Any]]:
    for channel, of_group in ((channel, g.properties) for g in tdms.groups() for channel in g.channels()):
        name = f"{channel.group_name}/{channel.name}"
        for properties in (channel.properties, of_group, tdms.properties):
            _check_scales(name, properties)
        if len(channel) == 0:
            unusable[name] = "holds no samples; record again, or name another"
        elif channel.dtype.kind not in "iuf":
            unusable[name] = f"holds {channel.dtype}, not real numbers; save numbers, or name another"
        else:
            yield name, channel


def _check_scales(name: str, properties: Mapping[str, Any]) -> None:
    """Raises ValueError for more scales than a channel has: the library makes each, whether it is described or not."""
    numbers = [int(found[1]) + 1 for key in properties if (found := _SCALE.match(key))]
    most = max([*numbers, int(properties.get("NI_Number_Of_Scales", 0))])
    if most > _MOST_SCALES:
        raise ValueError(f"'{name}' states {most} scales")


def _channel(path: Path, name: str, channel: Any) -> Channel:
    group_name, channel_name = channel.group_name, channel.name

    def load() -> Floats:
        with _opened(path) as tdms:
            return np.ascontiguousarray(tdms[group_name][channel_name][:], dtype=np.float64)

    properties = channel.properties
    step = properties.get("wf_increment")
    rate = None
    if isinstance(step, (int, float)) and step > 0:
        rate = StatedRate(1 / float(step), f"wf_increment = {float(step):g} s of '{name}'")
    return Channel(name, len(channel), load, str(properties.get("unit_string", "")), rate)


def check_structure(path: Path) -> None:
    """Follow the lead-ins from segment to segment; raises `RecordingError` where the chain breaks."""
    size = path.stat().st_size
    position, number = 0, 0
    with path.open("rb") as file:
        while position < size:
            file.seek(position)
            position += _LEAD_IN + _following(path, file.read(_LEAD_IN), number, position, size)
            number += 1


def _following(path: Path, lead: bytes, number: int, position: int, size: int) -> int:
    """Bytes of a segment behind its lead-in; raises `RecordingError` for a lead-in that cannot be true."""
    where = f"{path}: segment {number} of the TDMS file, at byte {position},"
    again = "copy the file again from its source, or open and save it in LabVIEW"
    if len(lead) >= 4 and lead[:4] != b"TDSm":
        raise RecordingError(f"{where} should begin with 'TDSm' and begins with {lead[:4]!r}; {again}.")
    if len(lead) < _LEAD_IN:
        raise RecordingError(f"{where} has {len(lead)} of the {_LEAD_IN} bytes of its lead-in; {again}.")
    mask = struct.unpack("<l", lead[4:8])[0]
    version, following, raw = struct.unpack(f"{'>' if mask & _BIG_ENDIAN else '<'}lQQ", lead[8:])
    if version not in _VERSIONS:
        raise RecordingError(f"{where} states version {version}; versions {_VERSIONS} are known; {again}.")
    if following == _INCOMPLETE:
        raise RecordingError(
            f"{where} was never completed: the program that wrote it stopped while recording; {again}, or record again."
        )
    missing = position + _LEAD_IN + following - size
    if missing > 0:
        raise RecordingError(f"{where} is truncated: {missing} of its {following} bytes are missing; {again}.")
    if raw > following:
        raise RecordingError(f"{where} places its data at byte {raw} of {following}; {again}.")
    return int(following)
