"""What is said while the first command on a machine compiles its loops."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from microrad.core import compiling

LOOP = """
import numpy as np
from microrad.core import compiling, kernels

print(kernels.is_compiled(kernels.lag_kernel))
compiling.on_first(lambda: print("compiling"))
for drive in (np.zeros(3), np.zeros(4)):
    kernels.lag_kernel(drive, 0.1, np.ones(1), np.zeros(1), np.empty((drive.size, 1)))
print("done")
"""


def test_it_is_said_once_before_the_first_loop_is_compiled_and_never_of_the_cache(tmp_path):
    """An edit in one file compiles the loops of the others anew.

    Machine code of one file holds what it merged from others, whose edits the compiler's own cache does not see.
    """
    core = tmp_path / "microrad" / "core"
    shutil.copytree(Path(compiling.__file__).parent, core, ignore=shutil.ignore_patterns("__pycache__"))
    (core.parent / "__init__.py").write_text("")
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / "cache"), "PYTHONPATH": str(tmp_path)}
    environment.pop("NUMBA_DISABLE_JIT", None)

    def said(**more):
        ran = subprocess.run(
            [sys.executable, "-c", LOOP], env=environment | more, capture_output=True, text=True, check=True
        )
        return ran.stdout.split()

    assert said() == ["False", "compiling", "done"]
    os.utime(core / "kernels" / "hysteresis.py")  # another clone, the same code
    assert said() == ["True", "done"]
    assert said(NUMBA_CPU_NAME="generic", NUMBA_CPU_FEATURES="") == ["False", "compiling", "done"]
    with (core / "kernels" / "ensemble.py").open("a") as other:
        other.write("# edited\n")
    assert said() == ["False", "compiling", "done"]


def test_a_forked_process_says_nothing_for_the_one_that_it_comes_from(monkeypatch):
    heard = []
    compiling.on_first(lambda: heard.append("compiling"))
    with monkeypatch.context() as other:
        other.setattr(os, "getpid", lambda: -1)
        compiling.begins()
    assert heard == []
    compiling.begins()
    compiling.begins()
    assert heard == ["compiling"]


@pytest.fixture(autouse=True)
def nobody_waits(monkeypatch):
    monkeypatch.setattr(compiling, "_waiting", {})
