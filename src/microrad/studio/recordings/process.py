"""The process that reads one recording for the studio: limits itself first, reads a request, writes one answer.

`reading` starts it and says what the answers hold: a request of that module comes in on stdin, as JSON, and the answer
leaves on stdout.
"""

from __future__ import annotations

import contextlib
import json
import math
import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from microrad.lab.recording.formats.source import Source

_TEXT = 200
_MOST = 50  # rates or findings that are told


class RefusedError(ValueError):
    """The file is not read, for the reason in the message."""


def main() -> None:
    """Read the request, answer it, and leave nothing else on stdout."""
    request = json.loads(sys.stdin.buffer.read())
    out = os.dup(1)
    silence = os.open(os.devnull, os.O_WRONLY)
    for stream in (1, 2):  # a library may print
        os.dup2(silence, stream)
    limit(request["limits"])
    answer = answer_to(request)
    with os.fdopen(out, "wb") as file:
        file.write(json.dumps(answer, allow_nan=False).encode("ascii"))


def limit(limits: dict[str, Any]) -> None:
    """Bound this process where the system can: memory, computing, time; it writes no file and leaves no core."""
    try:
        import resource
        import signal
    except ImportError:  # Windows; the parent's clock holds
        return
    cpu = int(limits["cpu_s"])
    bounds = (
        (resource.RLIMIT_AS, int(limits["memory_bytes"]), int(limits["memory_bytes"])),
        (resource.RLIMIT_CPU, cpu, cpu + 1),
        (resource.RLIMIT_FSIZE, 0, 0),
        (resource.RLIMIT_CORE, 0, 0),
    )
    for what, soft, hard in bounds:
        _, most = resource.getrlimit(what)
        most = hard if most == resource.RLIM_INFINITY else min(hard, most)
        with contextlib.suppress(OSError, ValueError):  # macOS refuses some; the others hold
            resource.setrlimit(what, (min(soft, most), most))
    signal.alarm(int(limits["wall_s"]) + 5)  # should the studio be gone


def answer_to(request: dict[str, Any]) -> dict[str, Any]:
    """The answer, or the refusal in words."""
    from microrad.lab.recording import RecordingError
    from microrad.lab.recording.files import check_file

    name = request["name"]
    try:
        os.chdir(request["folder"])  # messages then name the file without the folder
        check_file(Path(name))
        task = {"channels": channels, "view": view}[request["task"]]
        return task(Path(name), request)
    except (RecordingError, RefusedError) as error:
        return {"refused": str(error)[:4000]}
    except MemoryError:
        return {"refused": f"{name}: reading it takes more than {_memory(request)}; cut out the part that you need."}
    except Exception as error:  # a made-up file may raise anything in a library
        return {"refused": f"{name}: this cannot be read ({type(error).__name__}); copy it again from its source."}


def _memory(request: dict[str, Any]) -> str:
    return f"{request['limits']['memory_bytes'] / 1e9:.3g} GB of memory"


def opened(path: Path, request: dict[str, Any]) -> Source:
    """The file as channels, none of which claims more samples than may be read.

    Args:
        path: the recording.
        request: what `reading` asks for, with its limits.

    Raises:
        RefusedError: a channel claims more samples than may be read.
    """
    from microrad.lab.recording.reader import open_source

    source = open_source(path)
    most = request["limits"]["samples"]
    for name, samples in zip(source.names, source.samples(), strict=True):
        if samples is not None and samples > most:
            raise RefusedError(
                f"{path}: '{name[:_TEXT]}' states {samples} samples, and at most {most} are read here; cut out "
                "the part that you need, or keep every n-th sample."
            )
    return source


def channels(path: Path, request: dict[str, Any]) -> dict[str, Any]:
    """Names, units and lengths; see `reading.Listing`.

    Args:
        path: the recording.
        request: what `reading` asks for, with its limits.
    """
    from microrad.lab.recording.formats.source import is_time_name

    source = opened(path, request)
    most = request["limits"]["channels"]
    listed = list(zip(source.names, source.units, source.samples(), strict=True))[:most]
    rates = dict.fromkeys(r.rate_hz for r in source.rates(range(len(listed))) if math.isfinite(r.rate_hz))
    return {
        "channels": [{"name": name[:_TEXT], "unit": unit[:_TEXT], "samples": n} for name, unit, n in listed],
        "time": next((k for k, (name, _, _) in enumerate(listed) if is_time_name(name)), None),
        "rates_hz": list(rates)[:_MOST],
    }


def view(path: Path, request: dict[str, Any]) -> dict[str, Any]:
    """The recording, checked and thinned; see `reading.View`.

    Args:
        path: the recording.
        request: what `reading` asks for, with its columns and limits.
    """
    from microrad.lab.live_fit import extremes
    from microrad.lab.recording import read_recording

    opened(path, request)
    chosen = request["columns"]
    r = read_recording(
        path,
        chosen["inputs"],
        chosen["outputs"],
        chosen["rate_hz"],
        accept=chosen["accept"],
    )
    rows = extremes([*r.drive.T, *r.output.T], request["limits"]["points"])
    return {
        "samples": r.samples,
        "rate_hz": r.rate_hz,
        "findings": [f.message for f in r.findings[:_MOST]],
        "rows": rows.tolist(),
        "drive": [_digits(column[rows]) for column in r.drive.T],
        "output": [_digits(column[rows]) for column in r.output.T],
    }


def _digits(values: NDArray[np.float64]) -> list[float]:
    return [float(f"{value:.7g}") for value in values]


if __name__ == "__main__":
    main()
