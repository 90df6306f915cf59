"""What of a machine and of its libraries changes the last digits of a result, and nothing that says whose it is."""

import hashlib
import os
import platform
from collections.abc import Mapping
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

VARIABLES = (
    "GLIBC_TUNABLES",
    "NPY_DISABLE_CPU_FEATURES",
    "NPY_ENABLE_CPU_FEATURES",
    "NUMBA_CPU_FEATURES",
    "NUMBA_CPU_NAME",
    "NUMBA_DISABLE_JIT",
    "NUMBA_OPT",
    "OMP_NUM_THREADS",
    "OPENBLAS_BLOCK_FACTOR",
    "OPENBLAS_CORETYPE",
    "OPENBLAS_L2_SIZE",
    "OPENBLAS_NUM_THREADS",
)
"""Variables of the environment that choose instructions, or in how many parts a sum is made."""
ARCHITECTURE = "architecture"

LIBRARIES = (
    "microrad",
    "numpy",
    "scipy",
    "numba",
    "llvmlite",
    "xarray",
    "h5netcdf",
    "h5py",
    "contourpy",
    "pydantic",
    "sgp4",
    "skyfield",
)
"""Libraries that the numbers depend on, and the bytes that they are written in."""


def machine() -> dict[str, str]:
    """What arithmetic is done with here, by name; a variable that is not set is left out."""
    return {
        ARCHITECTURE: platform.machine(),
        "processor": _processor(),
        "instruction sets": _instruction_sets(),
        "C library": " ".join(filter(None, platform.libc_ver())) or platform.platform(terse=True),
        "numpy's BLAS": _blas(np),
        "scipy's BLAS": _scipy_blas(),
        **{name: os.environ[name] for name in VARIABLES if name in os.environ},
    }


def as_stated(stated: Any) -> dict[str, str]:
    """The machine of a manifest; one of version 0.1.0 has no more than the architecture, as a text."""
    return dict(stated) if isinstance(stated, Mapping) else {ARCHITECTURE: str(stated)} if stated else {}


def _processor() -> str:
    """The processor's kind, as the compiler of the loops names it."""
    from llvmlite.binding import get_host_cpu_name  # type: ignore[import-untyped]

    return str(get_host_cpu_name())


def _instruction_sets() -> str:
    """Those that numpy uses, beyond any that were disabled."""
    found = np.show_config(mode="dicts")["SIMD Extensions"]
    return " ".join([*found["baseline"], *found.get("found", [])])  # a plain processor has no more than the baseline


def _scipy_blas() -> str:
    import scipy

    return _blas(scipy)


def _blas(library: Any) -> str:
    found = library.show_config(mode="dicts")["Build Dependencies"]["blas"]
    return f"{found['name']} {found['version']}"


@cache
def _versions() -> tuple[tuple[str, str], ...]:
    return (("python", platform.python_version()), *((name, version(name)) for name in LIBRARIES))


def versions() -> dict[str, str]:
    """Versions of Python and of the libraries that the numbers depend on."""
    return dict(_versions())


@cache
def source_sha256() -> str:
    """SHA-256 over the names and contents of the package's files, but for those that only give a page its looks."""
    root, digest, looks = Path(__file__).resolve().parents[1], hashlib.sha256(), {".html", ".css", ".js"}
    files = (p for p in root.rglob("*") if p.is_file() and "__pycache__" not in p.parts and p.suffix not in looks)
    for path in sorted(files):
        digest.update(f"{path.relative_to(root).as_posix()}\0".encode() + hashlib.sha256(path.read_bytes()).digest())
    return digest.hexdigest()
