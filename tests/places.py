"""Where things stand: the project, and the recordings beside it, which may be absent."""

import importlib.util
import os
import sys
from pathlib import Path
from types import ModuleType

TESTS = Path(__file__).parent
ROOT = TESTS.parent
DATA = Path(os.environ.get("MICRORAD_DATA") or ROOT.parent / "shared" / "data")


def benchmark(name: str) -> ModuleType:
    """A benchmark as a module. Its folder is on the path only meanwhile: it would hide packages of the tests."""
    folder = ROOT / "benchmarks"
    spec = importlib.util.spec_from_file_location(f"benchmark_{name}", folder / f"{name}.py")
    assert spec is not None and spec.loader is not None
    made = sys.modules[spec.name] = importlib.util.module_from_spec(spec)
    sys.path.append(str(folder))
    try:
        spec.loader.exec_module(made)
    finally:
        sys.path.remove(str(folder))
    return made
