"""What runs the jobs of a campaign on one machine: threads of a worker process that may die, hang or be killed.

The jobs run in a process of their own, so that whatever they do to it, the campaign goes on.
"""

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

from microrad.campaign.engines.flights import SLICE_S, Clock, Flight, JobQueue, late_flights, late_reason
from microrad.campaign.engines.worker import Kind, Message, pack_job, read_message, write_message
from microrad.campaign.records import CampaignError, Job, Outcome
from microrad.core.folder import scratch_folder

_START_S = 300.0  # the first start on a machine compiles
_FALSE_STARTS = 3
_DEATHS = 20
_LINES_KEPT = 50
_LINES_SAID = 4


class _WorkerProcess:
    """A worker process: its messages in ``inbox`` (None at its end), when each job was heard of, what it said."""

    def __init__(self, spec: bytes, target: str, threads: int, late_s: float, clock: Clock) -> None:
        arguments = [target, str(threads), str(late_s), str(os.getpid())]
        self._folder = str(scratch_folder("worker"))  # it is killed, and would leave its own behind
        self.process = subprocess.Popen(
            [sys.executable, "-P", "-X", "faulthandler", "-m", "microrad.campaign.engines.worker", *arguments],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            env=os.environ | _ONE_THREAD_OF_BLAS | dict.fromkeys(("TMPDIR", "TEMP", "TMP"), self._folder),
        )
        self.inbox: SimpleQueue[Message | None] = SimpleQueue()
        self.heard: dict[int, float] = {}
        self.ready = False
        self.last_heard_s = clock.now()
        self._clock = clock
        self._lines: deque[str] = deque(maxlen=_LINES_KEPT)
        self._readers = [threading.Thread(target=read, daemon=True) for read in (self._listen, self._keep_lines)]
        for reader in self._readers:
            reader.start()
        self.send(Message(Kind.OPEN, 0, spec))

    def send(self, message: Message) -> None:
        """Send a message; one that has ended says so in its inbox."""
        assert self.process.stdin is not None
        with suppress(OSError):
            write_message(self.process.stdin, message)

    def _listen(self) -> None:
        assert self.process.stdout is not None
        with self.process.stdout as stream:
            while (message := read_message(stream)) is not None:
                self.last_heard_s = self._clock.now()
                if message.kind is Kind.BEAT:
                    self.heard[message.serial] = self.last_heard_s
                else:
                    self.inbox.put(message)
        self.inbox.put(None)

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
    """Runs jobs in ``threads`` threads of one worker process; see `records.Engine`.

    The process opens the work once, by ``target`` ("module:function") from ``spec``. A job of one row is run with no
    other beside it, so that a row is blamed for a death only by its own doing. A job that gives no sign of life for
    ``late_s`` (s) is stopped with the process; the others of that process are started again and nothing is said.
    Call it from a thread that lives as long as the engine.
    """

    def __init__(self, spec: bytes, target: str, threads: int, late_s: float) -> None:
        """The process starts with the first jobs."""
        self._spec, self._target, self._threads, self._late_s = spec, target, threads, late_s
        self._clock = Clock()
        self._worker: _WorkerProcess | None = None
        self._flights: dict[int, Flight] = {}
        self._serial = 0
        self._code = ""
        self._deaths = self._false_starts = 0
        self._closed = False

    def outcomes(self, jobs: Iterator[Job]) -> Iterator[Outcome]:
        """Outcomes as they come; ``jobs`` is asked again after each, also when it had none before.

        Raises CampaignError when the work cannot be opened or its process dies again and again.
        """
        queue = JobQueue(jobs)
        try:
            while True:
                worker = self._living_worker()
                self._feed(worker, queue)
                if worker.ready and not self._flights:
                    return
                yield from self._wait(worker, queue)
        finally:
            if self._flights:
                self._stop_worker()

    def close(self) -> None:
        """Stop at once."""
        if not self._closed:
            self._closed = True
            self._stop_worker()
            self._clock.close()

    def _living_worker(self) -> _WorkerProcess:
        if self._closed:
            raise CampaignError("the workers were stopped while jobs were running")
        if self._worker is None:
            self._worker = _WorkerProcess(self._spec, self._target, self._threads, self._late_s, self._clock)
        return self._worker

    def _stop_worker(self) -> None:
        worker, self._worker = self._worker, None
        self._flights.clear()
        if worker is not None:
            worker.kill()

    def _feed(self, worker: _WorkerProcess, queue: JobQueue) -> None:
        """Hand out jobs: one a thread, and one that a thread finds when it has done its own."""
        while worker.ready and len(self._flights) <= self._threads:
            job = queue.next()
            if job is None:
                return
            if self._flights and (job.kind == "row" or any(f.job.kind == "row" for f in self._flights.values())):
                queue.put_back(job)
                return
            if not self._flights:
                worker.last_heard_s = self._clock.now()
            self._serial += 1
            self._flights[self._serial] = Flight(job)
            worker.send(Message(Kind.JOB, self._serial, pack_job(job)))

    def _wait(self, worker: _WorkerProcess, queue: JobQueue) -> Iterator[Outcome]:
        """What happens within a slice."""
        with suppress(Empty):
            yield from self._take(worker, worker.inbox.get(timeout=SLICE_S), queue)
        if worker is self._worker:
            yield from self._stop_the_late(worker, queue)

    def _take(self, worker: _WorkerProcess, message: Message | None, queue: JobQueue) -> Iterator[Outcome]:
        """What a message, or the end of the worker, means."""
        if message is None:
            yield from self._worker_died(worker, queue)
        elif message.kind is Kind.READY:
            self._worker_ready(worker, message.body.decode())
        elif message.kind is Kind.REFUSED:
            self._stop_worker()
            raise CampaignError(message.body.decode())
        else:
            self._deaths = self._false_starts = 0
            yield _outcome(self._flights.pop(message.serial).job, message)

    def _worker_ready(self, worker: _WorkerProcess, code: str) -> None:
        """A worker is ready; one that runs other code than the first is refused."""
        if self._code and code != self._code:
            self._stop_worker()
            raise CampaignError(
                f"the code of microrad changed while the campaign ran: it began with {self._code}, now it is {code}; "
                "go back to the first, or begin the campaign anew"
            )
        self._code, worker.ready = code, True

    def _note_signs_of_life(self, worker: _WorkerProcess) -> None:
        for serial, flight in self._flights.items():
            flight.heard_s = worker.heard.get(serial, flight.heard_s)

    def _worker_died(self, worker: _WorkerProcess, queue: JobQueue) -> Iterator[Outcome]:
        """The worker has ended by itself: what it had begun has died, the rest starts again."""
        self._note_signs_of_life(worker)
        begun = [serial for serial, flight in self._flights.items() if flight.begun]
        for job in self._lose(worker, begun, queue):
            yield Outcome(job, "died", reason=f"its worker process {worker.ending()}")

    def _lose(self, worker: _WorkerProcess, lost: list[int], queue: JobQueue) -> list[Job]:
        """Stop the worker and return the jobs that are lost with it; all others start again."""
        flights = dict(self._flights)
        self._stop_worker()
        for serial, flight in reversed(flights.items()):
            if serial not in lost:
                queue.put_back(flight.job)
        self._count_death(worker)
        return [flights[serial].job for serial in lost]

    def _count_death(self, worker: _WorkerProcess) -> None:
        """Give up after many deaths in a row; after few where the process ends by itself before it can work."""
        self._deaths += 1
        self._false_starts += not worker.ready and worker.process.returncode >= 0
        if self._deaths >= _DEATHS or self._false_starts >= _FALSE_STARTS:
            raise CampaignError(
                f"the worker process ended {self._deaths} times without a job done between; the last {worker.ending()}"
            )

    def _stop_the_late(self, worker: _WorkerProcess, queue: JobQueue) -> Iterator[Outcome]:
        """Stop the worker if a job of it is late: the others start again."""
        self._note_signs_of_life(worker)
        now = self._clock.now()
        late = late_flights(self._flights, now, self._late_s)
        none_begun = not any(f.begun for f in self._flights.values())
        limit_s = self._late_s if worker.ready else _START_S
        if not late and not (none_begun and now - worker.last_heard_s > limit_s):
            return
        for job in self._lose(worker, late, queue):
            yield Outcome(job, "late", reason=late_reason(self._late_s))


def _outcome(job: Job, message: Message) -> Outcome:
    """The outcome of a job that has ended."""
    if message.kind is Kind.DONE:
        return Outcome(job, "done", message.body)
    return Outcome(job, "raised", reason=message.body.decode())
