"""What is expensive and the same for several files of tests: made by the first process of a run of tests that asks."""

import fcntl
import os
import pickle
import shutil
import tempfile
from pathlib import Path

FOLDER = "MICRORAD_TESTS_SHARED"
"""Variable of the environment that names the folder of this run of tests, the same for all its processes."""


def begin(config):
    """Make the folder in the process that starts the others; it goes when that one ends."""
    if not hasattr(config, "workerinput"):
        os.environ[FOLDER] = tempfile.mkdtemp(prefix="microrad-tests-")
        config.add_cleanup(lambda: shutil.rmtree(os.environ[FOLDER], ignore_errors=True))


def once(name, make):
    """What ``make()`` returns, pickled by the process that makes it; each caller has a copy of its own."""
    path = Path(os.environ[FOLDER]) / f"{name}.pickle"
    with path.with_suffix(".lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not path.exists():
            part = path.with_suffix(".part")
            part.write_bytes(pickle.dumps(make(), protocol=5))
            part.replace(path)
    return pickle.loads(path.read_bytes())


def found_once(run, of=lambda first: first):
    """A function from a mission's file to what is found of it, which finds it once for each text of a mission.

    For tests of what is said of it, where the same mission is asked for in several forms. ``of`` gives the file of the
    first argument. A mission that names other files is found each time: they may have changed.
    """
    found = {}

    def known(first, *args, **more):
        text = of(first).text
        if "file = " in text:
            return run(first, *args, **more)
        if text not in found:
            found[text] = run(first, *args, **more)
        return found[text]

    return known
