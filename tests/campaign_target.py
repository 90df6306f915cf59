"""Work for the tests of engines: the specification says by a job's number what it does, else it gives its own name."""

import ctypes
import json
import os
import signal
import sys
import time
from pathlib import Path

from microrad.campaign.records import CampaignError

DAY_S = 86400


def code_sha256():
    return os.environ.get("CODE_OF_TARGET", "c0de")


def open_work(spec):
    if spec == b"refuse":
        raise CampaignError("mission.toml: no such mission")
    if spec == b"die":
        print("cannot go on", file=sys.stderr, flush=True)
        os._exit(3)
    return Work(json.loads(spec))


def touch(mark):
    """Say that a deed has begun, where somebody waits for it."""
    if mark is not None:
        Path(mark).touch()


class Work:
    def __init__(self, table):
        self.table = table

    def do(self, job, beat):
        doing = self.table.get(str(job.number), self.table.get("else", "work"))
        getattr(self, doing.split()[0])(job, beat, *doing.split()[1:])
        return f"{job.cell}/{job.number}/{job.row}".encode()

    def work(self, job, beat):
        pass

    def slow(self, job, beat, times=5):
        for _ in range(int(times)):
            beat()
            time.sleep(0.01)

    def endless(self, job, beat, mark=None):
        touch(mark)
        while True:
            self.slow(job, beat)

    def quiet(self, job, beat, mark, end):
        touch(mark)
        while not Path(end).exists():
            time.sleep(0.01)

    def chat(self, job, beat):
        print("a line for stdout", flush=True)
        os.write(1, b"raw bytes for stdout")
        os.system("echo from a program")

    def shout(self, job, beat):
        raise ValueError("no mirror\n  at all")

    def refuse(self, job, beat):
        raise CampaignError("row 3: no mission")

    def leave(self, job, beat):
        sys.exit("enough")

    def hang(self, job, beat, mark=None):
        touch(mark)
        time.sleep(DAY_S)

    def hog(self, job, beat, mark=None):
        for _ in range(30):
            time.sleep(0.01)  # what the other threads have done gets out
        touch(mark)
        ctypes.PyDLL(None).sleep(DAY_S)  # never gives the interpreter's lock back

    def segfault(self, job, beat):
        ctypes.string_at(0)

    def killed(self, job, beat):
        os.kill(os.getpid(), signal.SIGKILL)

    def hang_once(self, job, beat, mark):
        self.once(mark, lambda: self.hang(job, beat))

    def endless_once(self, job, beat, mark):
        self.once(mark, lambda: self.endless(job, beat))

    def killed_once(self, job, beat, mark):
        self.once(mark, lambda: os.kill(os.getpid(), signal.SIGKILL))

    def once(self, mark, action):
        if not Path(mark).exists():
            Path(mark).touch()
            action()
