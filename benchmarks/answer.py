"""Seconds until an answer, for what a user and a contributor wait for, each beside its bar on two idle cores.

python benchmarks/answer.py            the commands of a user
python benchmarks/answer.py --suite    and `make test`, with what it keeps in place
python benchmarks/answer.py --clone    those of a stranger alone, in clones with empty caches: the first `make demo`,
                                       its packages installed before, `make test` and `.ci/run`

Seconds by the clock, and of all processors together. MICRORAD_DATA names the folder of recordings; what needs one that
is not there is left out by name.
"""

import os
import re
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Mapping
from pathlib import Path

from recorded import record

ROOT = Path(__file__).resolve().parent.parent
MISSION = (ROOT / "missions" / "leo-geo.toml").read_text(encoding="utf-8")
DATA = Path(os.environ.get("MICRORAD_DATA") or ROOT.parent / "shared" / "data")
LOOP = DATA / "piezo_1hz" / "Model_Vi_Do.dat"
RUN = ("run", "mission.toml", "--overwrite")
PLAN = "mirror-characterisation"
CLONED = ("demo", "suite", "gate")


CHANGES = (
    ("relay's aperture", "geo_aperture = ", '"16 cm"'),
    ("aperture (of the loop's sensor, too)", "leo_aperture = ", '"6 cm"'),
    ("data rate", "data_rate = ", '"200 Mbit/s"'),
    ("orbit", "altitude = ", '"520 km"'),
)


def main() -> None:
    """Print the table."""
    print(f"{'':64s} {'clock':>8s} {'processor':>10s} {'bar':>7s}")
    if "--clone" in sys.argv:
        clones()
        return
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        (place / "mission.toml").write_text(MISSION, encoding="utf-8")
        command(place, *RUN, "--fresh")  # compiles what is not compiled yet
        tell("microrad --help", 0.3, lambda: command(place, "--help"))
        tell("microrad run, nothing kept", 12.0, lambda: command(place, *RUN))
        tell("microrad run again", 6.0, lambda: command(place, *RUN))
        for what, key, value in CHANGES:
            (place / "mission.toml").write_text(changed(key, value), encoding="utf-8")
            tell(f"microrad run, another {what}", 4.0, lambda: command(place, *RUN))
        (place / "mission.toml").write_text(MISSION, encoding="utf-8")
        command(place, "bench", PLAN)
        tell(
            "microrad identify, the whole characterisation",
            40.0,
            lambda: command(place, "identify", f"{PLAN}-bench", "--mirror-file", "lab.toml"),
        )
        tell(
            "microrad design on that mirror",
            12.0,
            lambda: command(place, "design", "mission.toml", "--mirror", "lab.toml"),
        )
        if LOOP.exists():
            tell("microrad identify, one loop of 8000 samples", 10.0, lambda: command(place, "identify", *real_loop()))
        else:
            print(f"{'microrad identify, one loop of 8000 samples':64s} left out: {LOOP.name} is not here")
    if "--suite" in sys.argv:
        tell("make test, kernels compiled", 360.0, lambda: run(["make", "test"], ROOT, os.environ))


def clones() -> None:
    """What a stranger waits for: nothing is compiled or kept yet; only the installer's own downloads may be."""
    with tempfile.TemporaryDirectory() as folder:
        own = {key: value for key, value in os.environ.items() if not key.startswith(("XDG_", "NUMBA_", "MICRORAD_"))}
        own |= {"MICRORAD_DATA": str(DATA)}
        for name in CLONED:
            run(["git", "clone", "--quiet", str(ROOT), f"{folder}/{name}"], ROOT, own)
        at = {name: (Path(folder) / name, {**own, "XDG_CACHE_HOME": f"{folder}/{name}-cache"}) for name in CLONED}
        run(["make", ".venv/.run"], *at["demo"])
        tell("make demo, first in a clone, packages installed", 60.0, lambda: run(["make", "demo"], *at["demo"]))
        tell("make test in a clone, set-up included", 600.0, lambda: run(["make", "test"], *at["suite"]))
        tell(".ci/run in a clone, played machines included", 900.0, lambda: run(["bash", ".ci/run"], *at["gate"]))


def changed(key: str, value: str) -> str:
    """The mission with the first value of a key replaced."""
    found, count = re.subn(rf'({re.escape(key)})"[^"]*"', rf"\g<1>{value}", MISSION, count=1)
    assert count == 1, key
    return found


def real_loop() -> list[str]:
    """Arguments for the recorded 1 Hz loop, as docs/identify.md reads it."""
    named = {"input": "0", "output": "4", "rate": "200 Hz", "output-unit": "um", "lever-arm": "20 mm"}
    return [str(LOOP), "--overwrite", *(word for key, value in named.items() for word in (f"--{key}", value))]


def command(place: Path, *words: str) -> None:
    """A command of microrad in a folder, with its kept parts there."""
    as_usual = {key: value for key, value in os.environ.items() if key != "PYTHONDONTWRITEBYTECODE"}
    run([sys.executable, "-m", "microrad", *words], place, {**as_usual, "XDG_CACHE_HOME": str(place / "cache")})


def run(words: list[str], place: Path, environment: Mapping[str, str]) -> None:
    """Raises CalledProcessError for a command that fails; 1 is a mission that does not close."""
    done = subprocess.run(words, cwd=place, env=environment, capture_output=True, text=True, check=False)
    if done.returncode not in (0, 1):
        raise subprocess.CalledProcessError(done.returncode, words, done.stdout, done.stderr)


def tell(what: str, bar_s: float, do: Callable[[], None]) -> None:
    """Do it once and print its line."""
    before, began = processor_s(), time.perf_counter()
    do()
    clock = time.perf_counter() - began
    record(what, clock, "s", at_most=bar_s)
    print(
        f"{what:64s} {clock:6.1f} s {processor_s() - before:8.1f} s {bar_s:5.1f} s{'' if clock <= bar_s else '  over'}"
    )


def processor_s() -> float:
    """Seconds of processors that finished processes have taken so far."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


if __name__ == "__main__":
    main()
