"""How loops are compiled, and where their machine code is kept: the door of numba."""

from collections.abc import Callable
from hashlib import sha256
from pathlib import Path
from typing import Any, TypeVar

import numba
import numpy as np
from numba.core import config, event
from numba.core.caching import IndexDataCacheFile
from numba.core.codegen import get_host_cpu_features
from numpy.typing import NDArray

from microrad.core import compiling

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Indices = NDArray[np.uint64]  # unsigned: no test for a negative index in the innermost loop

# No run-time reference counts (an option numba keeps under an underscore): they cost ten times the arithmetic, and the
# loops allocate nothing. Contraction is the fused multiply-add that a C compiler uses by default; unlike fast-math
# it keeps nan and inf. Measured on the closed loop: 1600 ns a step with counts, 65 without.
_OPTIONS: dict[str, Any] = {
    "cache": True,
    "nogil": True,
    "error_model": "numpy",
    "fastmath": {"contract"},
    "_nrt": False,
    "no_cfunc_wrapper": True,
}
inlined: Callable[[Any], Any] = numba.njit(inline="always", **_OPTIONS)

# The compiler uses half of a vector of 512 bits, which slowed the first processors that had them; those since Ice Lake
# and Zen 4, which have VBMI2, too, gain by the whole. Many runs side by side: 0.33 of the C twin, 0.39 with half of it.
numba_config: Any = config
_features: str = get_host_cpu_features()  # type: ignore[no-untyped-call]
if numba_config.CPU_NAME is None and numba_config.CPU_FEATURES is None and "+avx512vbmi2" in _features:
    numba_config.CPU_FEATURES = f"{_features},-prefer-256-bit"


class _Compiling(event.Listener):
    """Says that a loop is compiled; what is loaded from the cache is none."""

    def on_start(self, event: Any) -> None:
        compiling.begins()

    def on_end(self, event: Any) -> None:
        pass


event.register("numba:compile", _Compiling())  # type: ignore[no-untyped-call]


class CacheFile(IndexDataCacheFile):
    """Machine code in files named by what they hold, written before the index names them.

    Numba counts its files: two processes that compile at once write different code under one number, and a later one
    loads the wrong one (seen: an IndexError in half the runs behind a cold parallel start).
    """

    def save(self, key: Any, data: Any) -> None:
        """Write the machine code of one signature, and then the index.

        Args:
            key: What the index finds it by: signature, processor and code.
            data: The compiled function, as numba has it written.
        """
        name = f"{self._index_name.removesuffix('.nbi')}.{sha256(repr(key).encode()).hexdigest()[:16]}.nbc"
        self._save_data(name, data)  # type: ignore[no-untyped-call]
        self._save_index({**self._load_index(), key: name})  # type: ignore[no-untyped-call]


def source_stamp(folder: Path) -> str:
    """SHA-256 over the Python files of a folder: the machine code of one holds what it merged from the others."""
    files = sorted(folder.glob("*.py"))
    return sha256(b"".join(file.name.encode() + b"\0" + file.read_bytes() for file in files)).hexdigest()


SOURCES = source_stamp(Path(__file__).parent)


def compiled_loop(function: Callable[..., Any], **options: Any) -> Any:
    """The function compiled, with its machine code kept in a cache that several processes may share.

    Args:
        function: A loop that checks nothing and allocates nothing.
        options: More options of `numba.njit`, by name.
    """
    compiled = numba.njit(**_OPTIONS, **options)(function)
    if cache := getattr(compiled, "_cache", None):  # none under NUMBA_DISABLE_JIT
        cache._cache_file.__class__ = CacheFile
        cache._cache_file._source_stamp = SOURCES
    return compiled


def is_compiled(loop: Any) -> bool:
    """Whether the cache holds machine code of this loop for this processor."""
    cache = getattr(loop, "_cache", None)
    if cache is None:  # under NUMBA_DISABLE_JIT
        return True
    _, *ours = cache._index_key((), loop.targetctx.codegen())  # signature, processor, code
    return any([*key[1:]] == ours for key in cache._cache_file._load_index())


def merged(function: Callable[..., Any]) -> Any:
    """Compiled by itself, and merged into its caller by the machine-code compiler: quick to compile and to call.

    Not for a function of two whole records that is called at one place: their hundreds of numbers are arguments. Only
    compiled functions may call it: from Python the process would end.
    """
    return compiled_loop(function, forceinline=True, no_cpython_wrapper=True)


# What has as many items as there are of something; the items mean nothing. The length of a tuple is part of its type:
# short loops over it are unrolled, but each new set of lengths is compiled again, for seconds. The length of an array
# is a number like any other: one compiled loop serves all sizes, at half the speed where they are small.
Count = tuple[int, ...] | Floats

UNROLLED = {"states": 5, "actuators": 1, "outputs": 1, "elements": 1, "operators": 0}  # the paper's mirror, on one axis
UNROLLED_CONTROLLER = 2  # states of a PID


def counts(unrolled: bool, **sizes: int) -> dict[str, Any]:
    """The counts of a `Plant` or a `Loop`, by field.

    Args:
        unrolled: Whether the loops over them are unrolled: then they are tuples, else arrays (see `Count`).
        sizes: How many there are, by field.
    """
    return {name: (0,) * size if unrolled else np.zeros(size) for name, size in sizes.items()}


_Record = TypeVar("_Record", bound=tuple[Any, ...])


def by_rows(record: _Record) -> _Record:
    """The named tuple with its arrays row by row in memory: any other order would compile the loops once more."""
    return type(record)(*(np.ascontiguousarray(v) if isinstance(v, np.ndarray) else v for v in record))
