"""What runs the jobs of a campaign on one machine: worker processes that may die, hang or be killed.

Each process has one job at a time, so that what a job does to its process is its own affair, and rows of links, which
are Python code, are computed side by side.
"""

import json
import os
import shutil
import signal
import subprocess
import sys
import threading
from collections import deque
from collections.abc import Iterator
from contextlib import suppress
from queue import Empty, SimpleQueue
from typing import Literal

from microrad.campaign.engines.jobs import SLICE_S, Clock, JobQueue, late_reason
from microrad.campaign.engines.worker import Kind, Message, read_message, write_message
from microrad.campaign.records import CampaignError, Job, Outcome
from microrad.core.folder import scratch_folder

_START_S = 300.0  # the first start on a machine compiles
_FALSE_STARTS, _DEATHS = 3, 20  # in a row, or more where there are many processes: all may end for one reason
_LINES_KEPT = 50
_LINES_SAID = 4


class _WorkerProcess:
    """A worker process with the job that it has; its messages go to ``inbox``, None at its end."""

    def __init__(
        self, target: str, late_s: float, clock: Clock, inbox: "SimpleQueue[tuple[object, Message | None]]"
    ) -> None:
        self._folder = str(scratch_folder("worker"))  # it is killed, and would leave its own behind
        self.process = subprocess.Popen(
            [
                *(sys.executable, "-P", "-X", "faulthandler", "-m", "microrad.campaign.engines.worker"),
                *(target, str(late_s), str(os.getpid())),
            ],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            env=os.environ | _ONE_THREAD_OF_BLAS | dict.fromkeys(("TMPDIR", "TEMP", "TMP"), self._folder),
        )
        self.job: Job | None = None
        self.begun = self.ready = False
        self.heard_s = clock.now()
        self._clock, self._inbox = clock, inbox
        self._lines: deque[str] = deque(maxlen=_LINES_KEPT)
        self._readers = [threading.Thread(target=read, daemon=True) for read in (self._listen, self._keep_lines)]
        for reader in self._readers:
            reader.start()

    def open(self, spec: bytes) -> None:
        """Give it the work. It may wait for the process to begin, so whoever may have to kill it knows it by then."""
        self._send(Message(Kind.OPEN, spec))

    def begin(self, job: Job) -> None:
        """Give it a job; it has none."""
        self.job, self.begun, self.heard_s = job, False, self._clock.now()
        self._send(Message(Kind.JOB, json.dumps(job).encode()))

    def _send(self, message: Message) -> None:
        """Send a message; a process that has ended says so in the inbox."""
        assert self.process.stdin is not None
        with suppress(OSError):
            write_message(self.process.stdin, message)

    def _listen(self) -> None:
        assert self.process.stdout is not None
        with self.process.stdout as stream:
            while (message := read_message(stream)) is not None:
                self.heard_s = self._clock.now()
                if message.kind is Kind.BEAT:
                    self.begun = True
                else:
                    self._inbox.put((self, message))
        self._inbox.put((self, None))

    def _keep_lines(self) -> None:
        assert self.process.stderr is not None
        with self.process.stderr as stream:
            for line in stream:
                self._lines.append(line.decode(errors="replace").rstrip())

    def kill(self) -> None:
        """End it at once, whatever it does."""
        self.process.kill()
        self.process.wait()
        for reader in self._readers:
            reader.join()
        assert self.process.stdin is not None
        with suppress(OSError):
            self.process.stdin.close()
        shutil.rmtree(self._folder, ignore_errors=True)

    def ending(self) -> str:
        """How it ended, in words, with its last lines."""
        lines = [line.strip() for line in self._lines if line.strip()]
        crash = next((k for k, line in enumerate(lines) if line.startswith("Fatal Python error")), -_LINES_SAID)
        said = " / ".join(lines[crash:][:_LINES_SAID])
        return _exit_words(self.process.returncode) + (f"; its last words: {said}" if said else "")


# Sums of a matrix product depend on the number of threads that make it: results are the same on every machine.
_ONE_THREAD_OF_BLAS = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "MKL_NUM_THREADS": "1"}


def _exit_words(code: int) -> str:
    """What an exit code (negative: the signal) says."""
    if code >= 0:
        return f"ended with exit code {code}"
    try:
        name = signal.Signals(-code).name
    except ValueError:
        name = f"signal {-code}"
    hint = " (if nobody stopped it, the machine ran out of memory)" if name == "SIGKILL" else ""
    return f"was ended by {name}{hint}"


class LocalEngine:
    """Runs jobs on ``processes`` worker processes; see `records.Engine`.

    Each process opens the work once, by ``target`` ("module:function") from ``spec``. A job that gives no sign of life
    for ``late_s`` (s) is stopped with its process. Call it from a thread that lives as long as the engine.
    """

    def __init__(self, spec: bytes, target: str, processes: int, late_s: float) -> None:
        """The processes start with the first jobs.

        Args:
            spec: the campaign, as the target's function opens it.
            target: "module:function" that each process calls once.
            processes: how many, at most.
            late_s: how long (s) a job may give no sign of life.
        """
        self._spec, self._target, self._processes, self._late_s = spec, target, processes, late_s
        self._clock = Clock()
        self._inbox: SimpleQueue[tuple[object, Message | None]] = SimpleQueue()
        self._workers: list[_WorkerProcess] = []
        self._code = ""
        self._deaths = self._false_starts = 0
        self._closed = False

    def outcomes(self, jobs: Iterator[Job]) -> Iterator[Outcome]:
        """Outcomes as they come; ``jobs`` is asked again after each, also when it had none before.

        Raises CampaignError when the work cannot be opened or its processes die again and again.
        """
        queue = JobQueue(jobs)
        try:
            while self._feed(queue):
                with suppress(Empty):
                    worker, message = self._inbox.get(timeout=SLICE_S)
                    yield from self._take(worker, message, queue)
                if self._inbox.empty():  # else a job that has ended meanwhile would seem late
                    yield from self._stop_the_late(queue)
        finally:
            if any(worker.job for worker in self._workers):
                self._stop(*self._workers)

    def close(self) -> None:
        """Stop at once."""
        if not self._closed:
            self._closed = True
            self._stop(*self._workers)
            self._clock.close()

    def _stop(self, *workers: _WorkerProcess) -> None:
        for worker in workers:
            worker.kill()
            with suppress(ValueError):  # another thread has closed the engine
                self._workers.remove(worker)

    def _feed(self, queue: JobQueue) -> bool:
        """Give each worker without a job one, and start workers for more; whether any has one."""
        while True:
            idle = next((worker for worker in self._workers if worker.job is None), None)
            job = queue.next() if idle is not None or len(self._workers) < self._processes else None
            if self._closed:
                raise CampaignError("the workers were stopped while jobs were running")
            if job is None:
                return any(worker.job for worker in self._workers)
            if idle is None:
                idle = _WorkerProcess(self._target, self._late_s, self._clock, self._inbox)
                self._workers.append(idle)
                idle.open(self._spec)
            idle.begin(job)

    def _take(self, worker: object, message: Message | None, queue: JobQueue) -> Iterator[Outcome]:
        """What a message, or the end of a worker, means; of one that was stopped it means nothing."""
        if worker not in self._workers:
            return
        assert isinstance(worker, _WorkerProcess)
        if message is None:
            yield from self._lost(worker, queue, "died")
        elif message.kind is Kind.READY:
            self._worker_ready(worker, message.body.decode())
        elif message.kind is Kind.REFUSED:
            raise CampaignError(message.body.decode())
        elif worker.job is not None:
            job, worker.job = worker.job, None
            self._deaths = self._false_starts = 0
            is_done = message.kind is Kind.DONE
            yield (
                Outcome(job, "done", message.body) if is_done else Outcome(job, "raised", reason=message.body.decode())
            )

    def _worker_ready(self, worker: _WorkerProcess, code: str) -> None:
        """A worker is ready; one that runs other code than the first is refused."""
        if self._code and code != self._code:
            raise CampaignError(
                f"the code of microrad changed while the campaign ran: it began with {self._code}, now it is {code}; "
                "go back to the first, or begin the campaign anew"
            )
        self._code, worker.ready = code, True

    def _stop_the_late(self, queue: JobQueue) -> Iterator[Outcome]:
        """Stop the workers that give no sign of life."""
        now = self._clock.now()
        for worker in list(self._workers):
            limit_s = self._late_s if worker.ready else _START_S
            if worker.job is not None and now - worker.heard_s > limit_s:
                yield from self._lost(worker, queue, "late")

    def _lost(self, worker: _WorkerProcess, queue: JobQueue, kind: Literal["died", "late"]) -> Iterator[Outcome]:
        """A worker has ended or is stopped: the job that it had begun is lost with it, one it had not starts again.

        Gives up after many such ends in a row, after few where the process ends by itself before it can work.
        """
        self._stop(worker)
        self._deaths += 1
        self._false_starts += not worker.ready and worker.process.returncode >= 0
        most_false, most = max(_FALSE_STARTS, self._processes + 1), max(_DEATHS, 2 * self._processes)
        if self._deaths >= most or self._false_starts >= most_false:
            raise CampaignError(
                f"worker processes ended {self._deaths} times without a job done between; the last {worker.ending()}"
            )
        if worker.job is None:
            return
        if not worker.begun:
            queue.put_back(worker.job)
            return
        reason = late_reason(self._late_s) if kind == "late" else f"its worker process {worker.ending()}"
        yield Outcome(worker.job, kind, reason=reason)
