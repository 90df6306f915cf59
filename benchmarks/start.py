"""Wall-clock time of the commands a user waits for: help, and the paper's mission with a warm kernel cache.

python benchmarks/start.py
"""

import subprocess
import sys
import tempfile
import time
from pathlib import Path

MISSION = Path(__file__).resolve().parent.parent / "missions" / "leo-geo.toml"
REPEATS = 5


def seconds(*arguments: str) -> float:
    began = time.perf_counter()
    subprocess.run([sys.executable, "-m", "microrad", *arguments], check=True, capture_output=True)
    return time.perf_counter() - began


def main() -> None:
    with tempfile.TemporaryDirectory() as folder:
        run = ("run", str(MISSION), "--output", str(Path(folder) / "study"), "--overwrite")
        seconds(*run)  # compiles when the cache is cold
        for name, arguments in {"microrad --help": ("--help",), "microrad run, warm": run}.items():
            times = sorted(seconds(*arguments) for _ in range(REPEATS))
            print(f"{name:20s} best {times[0]:.2f} s, median {times[REPEATS // 2]:.2f} s of {REPEATS}")


if __name__ == "__main__":
    main()
