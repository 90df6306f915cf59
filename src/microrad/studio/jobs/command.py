"""The command of a job: microrad, which ends with the process that watches over it, however that one ends.

Started by `process` as ``python -m microrad.studio.jobs.command WATCHER ARGUMENTS``; a pipe at stdin is held open
by the watcher alone. Without it nobody would hear that the job is to stop, and the page would call it lost while it
goes on.
"""

from __future__ import annotations

import os
import runpy
import signal
import sys
import threading


def end_with(pipe: int) -> None:
    """Wait until nobody holds the other end of a pipe, then end this process and what it has started."""
    while os.read(pipe, 4096):
        pass
    if hasattr(os, "killpg") and os.getpgrp() == os.getpid():
        os.killpg(os.getpid(), signal.SIGKILL)
    os._exit(1)


def _taken_stdin() -> int:
    """The pipe at stdin, in whose place there is nothing to read any more."""
    pipe, nothing = os.dup(0), os.open(os.devnull, os.O_RDONLY)
    os.dup2(nothing, 0)
    os.close(nothing)
    return pipe


def main() -> None:
    """Run microrad with the arguments behind the number of the watcher."""
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # as the command line does, before numpy is loaded
    from microrad.campaign.engines.worker import die_with_parent

    watcher, *arguments = sys.argv[1:]
    pipe = _taken_stdin()
    if not die_with_parent(int(watcher)):  # only Linux can
        threading.Thread(target=end_with, args=(pipe,), daemon=True, name="watch").start()
    sys.argv = ["microrad", *arguments]
    runpy.run_module("microrad", run_name="__main__", alter_sys=True)


if __name__ == "__main__":
    main()
