"""Checks of the installation: versions, the compiled kernels against a known number, their cache, the packaged mission.

Libraries and our own modules are imported inside the probes: one that does not load is a line of the answer.
"""

import os
import platform
import re
import sys
import tempfile
import textwrap
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import partial
from importlib import import_module, metadata, resources
from pathlib import Path

from microrad.core.installing import advice
from microrad.core.integrity import from_source, other_versions

# The loop of Eq. 3 of SPIE 11852, 118523B, with the printed parameters and u = 6 sin(2 pi 100 Hz t) + 6 V at 50 kHz:
# width in % of the peak-to-peak output and max|h| in µrad, found with an adaptive solver too.
LOOP_WIDTH_PERCENT = 14.05
LARGEST_HYSTERESIS_URAD = 74.44
_TOLERANCE = 0.01  # in the units above: the last printed digit

_FLOOR = re.compile(r"([A-Za-z0-9_.-]+)\s*>=\s*([0-9.]+)")
_REINSTALL = f"install again {advice('', '--force-reinstall')}"
_PINNED = "pinned versions"
_CACHE_ADVICE = "set NUMBA_CACHE_DIR to a folder that you may write to: without a cache every start compiles anew"


@dataclass(frozen=True, slots=True)
class Check:
    """One line of the answer: what was looked at, whether it is in order, what was found, and what to do if not."""

    name: str
    ok: bool
    found: str
    advice: str = ""


def run() -> tuple[Check, ...]:
    """Every check, in the order in which a fault of one explains a fault of the next."""
    return (
        _check("python", _python, "use a Python that microrad supports"),
        *_libraries(),
        _pins(),
        _check("kernels", _kernels, f"reinstall numba, or {_CACHE_ADVICE}"),
        _check("kernel cache", _cache, _CACHE_ADVICE),
        _check("packaged mission", _mission, _REINSTALL),
    )


def text(checks: Iterable[Check], width: int) -> str:
    """A line for each check; what goes on is set in.

    Args:
        checks: What was looked at.
        width: Most columns, but for a single word that is longer.
    """
    lines = (
        f"{'ok' if c.ok else 'problem':8} {c.name:17} {'; '.join(filter(None, (c.found, c.advice)))}" for c in checks
    )
    whole = textwrap.TextWrapper(width, subsequent_indent=" " * 9, break_long_words=False, break_on_hyphens=False)
    return "\n".join("\n".join(whole.wrap(line)) for line in lines)


def _check(name: str, probe: Callable[[], tuple[bool, str]], advice: str) -> Check:
    """The outcome of a probe; whatever it raises is what is wrong."""
    try:
        ok, found = probe()
    except Exception as error:
        reason = next(iter(str(error).splitlines()), "")
        ok, found = False, f"{type(error).__name__}: {reason}"
    return Check(name, ok, found, "" if ok else advice)


# ----------------------------------------------------------------------------------------------------------- versions
def _python() -> tuple[bool, str]:
    wanted = metadata.metadata("microrad")["Requires-Python"]
    lowest, below = (re.search(rf"{sign}\s*([0-9.]+)", wanted) for sign in (">=", "<"))
    version = _numbers(platform.python_version())
    fits = (not lowest or version >= _numbers(lowest[1])) and (not below or version < _numbers(below[1]))
    return fits, f"{platform.python_version()} ({sys.executable}), wanted {wanted}"


def _libraries() -> Iterator[Check]:
    """microrad itself and each library that it needs: installed, new enough, and loading."""
    yield _check("microrad", lambda: (True, metadata.version("microrad")), _REINSTALL)
    for requirement in metadata.requires("microrad") or ():
        match = _FLOOR.match(requirement)
        if match and "extra ==" not in requirement:
            name, lowest = match[1], match[2]
            yield _check(name, partial(_library, name, lowest), f"python -m pip install '{name}>={lowest}'")


def _library(name: str, lowest: str) -> tuple[bool, str]:
    version = metadata.version(name)
    import_module(name)
    return _numbers(version) >= _numbers(lowest), f"{version}, wanted {lowest} or later"


def _pins() -> Check:
    """Whether all that is installed has the version that was tested: the first suspect of a number that differs."""
    other = other_versions()
    if other is None:
        return Check(_PINNED, True, "not compared: nothing says which versions were tested")
    if not other:
        return Check(_PINNED, True, "those of constraints.txt")
    if not from_source():  # where another one is the user's choice
        return Check(_PINNED, True, f"not all of those that were tested: {', '.join(other.values())}")
    command = f"in the project's folder: python -m pip install --constraint constraints.txt {' '.join(other)}"
    return Check(_PINNED, False, f"not those of constraints.txt: {', '.join(other.values())}", command)


def _numbers(version: str) -> tuple[int, ...]:
    return tuple(int(part) for part in re.findall(r"\d+", version)[:3])


# ------------------------------------------------------------------------------------------------------------ kernels
def _kernels() -> tuple[bool, str]:
    from microrad.mirror import hysteresis

    printed = hysteresis.BoucWen(0.089e-3, -2.96e-7, -0.048e-3, 0.00047, 38.421, 34.635, 3770.0, 6.0)
    loop = printed.loop(6.0, 100.0)
    width, largest = 100 * loop.width, 1e6 * float(abs(loop.hysteresis_rad).max())
    agrees = abs(width - LOOP_WIDTH_PERCENT) <= _TOLERANCE and abs(largest - LARGEST_HYSTERESIS_URAD) <= _TOLERANCE
    return agrees, (
        f"loop width {width:.2f} % (known: {LOOP_WIDTH_PERCENT} %), "
        f"max|h| {largest:.2f} µrad (known: {LARGEST_HYSTERESIS_URAD} µrad)"
    )


def _cache() -> tuple[bool, str]:
    from microrad.core import kernels

    stats = getattr(kernels.closed_loop, "stats", None)
    if stats is None:
        return False, "compilation is switched off by NUMBA_DISABLE_JIT: unset it, or a study takes hours"
    folder = Path(stats.cache_path)
    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryFile(dir=folder):
        return True, f"{folder} is writable"


def _mission() -> tuple[bool, str]:
    from microrad.mission.file import load_mission

    packaged = resources.files("microrad.mission").joinpath("missions", "leo-geo.toml")
    with resources.as_file(packaged) as path:
        return True, f"{os.fspath(path)}: {load_mission(path).mission.name}"
