"""What runs the jobs of a campaign on many machines: the workers of a dask cluster.

Workers get the specification once, by name, and jobs as plain numbers; results are bytes. A worker says over the
scheduler's log of events when it begins a job (and waits until the scheduler knows) and that it still lives; this
side hears it and stops the worker of a job that is late.
"""

import asyncio
import logging
import os
import signal
import threading
import time
import uuid
from collections.abc import Callable, Iterator
from concurrent.futures import CancelledError, ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass, field
from hashlib import sha256
from queue import Empty, SimpleQueue
from typing import Any

from microrad.campaign.engines.jobs import SLICE_S, Clock, JobQueue, late_reason
from microrad.campaign.engines.worker import Beat, Kind, Work, beat_every_s, code_sha256, open_target, words
from microrad.campaign.records import CampaignError, Job, Outcome
from microrad.core.installing import advice

_ANSWER_S = 20.0  # a scheduler or worker that does not answer for so long is gone
_CONNECT_S = 10.0
_LOST_S = 5.0
_NO_WORKERS_S = 60.0
_LOOK_S = 1.0
_AHEAD = 2
_KILL = getattr(signal, "SIGKILL", signal.SIGTERM)  # on Windows the latter kills


# ------------------------------------------------------------------------------------------------------- on a worker
class _StoppedError(Exception):
    """The campaign has gone; the job ends at its next beat."""


@dataclass(slots=True)
class _Opening:
    """A specification that a worker has, and the work that its first job makes of it."""

    target: str
    spec: bytes
    code: str
    work: Work | None = None
    stopped: bool = False
    lock: threading.Lock = field(default_factory=threading.Lock)

    def opened(self) -> Work:
        """The work; CampaignError where this worker's code is other than that of the campaign."""
        with self.lock:
            if self.work is None:
                code = code_sha256(self.target)
                if code != self.code:
                    raise CampaignError(f"runs other code of microrad: {code}, where the campaign's is {self.code}")
                self.work = open_target(self.target, self.spec)
            return self.work


_openings: dict[str, _Opening] = {}


def install(name: str, target: str, spec: bytes, code: str) -> None:
    """Give this worker a specification.

    Args:
        name: what the specification is called from now on.
        target: "module:function" that opens it.
        spec: the specification.
        code: SHA-256 of the campaign's code.
    """
    _openings.setdefault(name, _Opening(target, spec, code))


def forget(name: str) -> None:
    """Take the specification back; jobs under way end at their next beat."""
    opening = _openings.pop(name, None)
    if opening is not None:
        opening.stopped = True


def kill(dask_worker: Any) -> None:
    """Asked of a nanny: kill its worker, whatever that does; the nanny starts another."""
    os.kill(dask_worker.pid, _KILL)


def do(name: str, topic: str, serial: int, job: tuple[int, int, int, str], every_s: float) -> bytes:
    """Do a job on a worker: a `Kind` in the first byte, then the result, or why there is none.

    Args:
        name: what the specification is called.
        topic: where the scheduler logs signs of life.
        serial: the number by which this side knows the job.
        job: the fields of a `Job`.
        every_s: least time (s) between two signs of life.
    """
    from distributed import get_worker

    opening, worker = _openings.get(name), get_worker()
    if opening is None:
        return _answer(Kind.OPEN, worker.address)
    try:
        work = opening.opened()
    except BaseException as error:
        return _answer(Kind.REFUSED, f"the worker at {worker.address}: {words(error)}")
    _tell_now(worker, topic, [serial, worker.address])
    beat = Beat(lambda: worker.log_event(topic, [serial, worker.address]), every_s)

    def living() -> None:
        if opening.stopped:
            raise _StoppedError
        beat()

    try:
        return bytes([Kind.DONE]) + work.do(Job(*job), living)  # type: ignore[arg-type]
    except BaseException as error:  # whatever it was, it is this job's
        return _answer(Kind.RAISED, words(error))


def _answer(kind: Kind, text: str) -> bytes:
    return bytes([kind]) + text.encode()


def _tell_now(worker: Any, topic: str, message: list[Any]) -> None:
    """Tell the scheduler and wait until it knows: what a death of this worker hits must be known before."""
    from distributed.utils import sync

    sync(worker.loop, worker.scheduler.log_event, topic=topic, msg=message)


# --------------------------------------------------------------------------------------------------------- this side
@dataclass(slots=True)
class Flight:
    """A job handed to a worker: when it was last heard of (s, of a `Clock`), nan before it has begun; where it runs."""

    job: Job
    heard_s: float = float("nan")
    where: str = ""

    @property
    def begun(self) -> bool:
        """Whether a worker has begun it."""
        return self.heard_s == self.heard_s


def late_flights(flights: dict[int, Flight], now_s: float, late_s: float) -> list[int]:
    """The serial numbers of the flights that were not heard of for too long.

    Where there is one, those silent for more than half as long are late too: a job that keeps the interpreter to itself
    silences its neighbours, and which of them was the last to be heard says nothing.

    Args:
        flights: those under way, by serial number.
        now_s: the time (s) of the clock that they were heard by.
        late_s: how long (s) is too long.
    """
    silent = {serial: now_s - f.heard_s for serial, f in flights.items() if f.begun}
    limit = late_s / 2.0 if max(silent.values(), default=0.0) > late_s else late_s
    return [serial for serial, silence in silent.items() if silence > limit]


def _distributed() -> Any:
    """The package, or CampaignError where it is not installed."""
    try:
        import distributed
    except ImportError as error:
        raise CampaignError(
            f"a cluster needs the package distributed ({error}): install it {advice('cluster')}"
        ) from None
    return distributed


def _quiet() -> Callable[[], None]:
    """Silence what distributed logs on its own; returns what undoes it. Losses are told by this module's errors."""
    loggers = [logging.getLogger(name) for name in logging.root.manager.loggerDict if name.startswith("distributed")]
    before = [(logger, logger.level) for logger in loggers]

    def undo() -> None:
        for logger, level in before:
            logger.setLevel(level)

    for logger in loggers:
        logger.setLevel(logging.CRITICAL + 1)
    return undo


async def _asked(distributed: Any, address: str) -> None:
    """Ask a scheduler who it is: a client waits for ever for one that takes its call and says nothing."""
    scheduler = distributed.rpc(address)
    try:
        await asyncio.wait_for(scheduler.identity(), _CONNECT_S)
    except TimeoutError:
        raise TimeoutError(f"it did not answer for {_CONNECT_S:g} s") from None
    finally:
        await scheduler.close_rpc()


class DaskEngine:
    """Runs jobs on the workers of the scheduler at ``address``.

    See `records.Engine`. About two jobs a thread of the workers are under way. A job whose worker dies has died after
    as many deaths as the scheduler allows (``allowed-failures``); one that only waited there is started again. A job
    that gives no sign of life for ``late_s`` (s) is late and its worker is killed and started again by its nanny; a
    worker without one is sent away. Raises CampaignError where the package distributed is missing, no scheduler
    answers, or a worker has no microrad or other code.
    """

    def __init__(self, spec: bytes, target: str, address: str, late_s: float = 300.0) -> None:
        """Connect.

        Args:
            spec: the campaign, as the target's function opens it.
            target: "module:function" on the workers.
            address: that of the scheduler.
            late_s: how long (s) a job may give no sign of life.
        """
        distributed = _distributed()
        self._code = code_sha256(target)
        self._undo_quiet = _quiet()
        self._late_s = late_s
        self._target, self._spec = target, spec
        self._name = sha256(b"\0".join([target.encode(), self._code.encode(), spec])).hexdigest()
        self._topic = f"microrad-{uuid.uuid4().hex}"
        self._flights: dict[int, Flight] = {}
        self._futures: dict[int, Any] = {}
        self._forgiven: set[int] = set()
        self._ended: SimpleQueue[int] = SimpleQueue()
        self._serial = 0
        self._threads: dict[str, int] = {}
        self._installed: set[str] = set()
        self._looked_s = float("-inf")
        self._closed = False
        self._clock = Clock()
        self.address = address
        self._client = self._connect(distributed)
        self._workers_seen_s = self._clock.now()

    def _connect(self, distributed: Any) -> Any:
        try:
            with ThreadPoolExecutor(1) as thread:  # this one may have a loop already, as in a notebook
                thread.submit(asyncio.run, _asked(distributed, self.address)).result()
            client = distributed.Client(self.address, timeout=_CONNECT_S, set_as_default=False)
            client.subscribe_topic(self._topic, self._hear)
            return client
        except Exception as error:  # of many kinds: an address without its certificate or package, no loop of its own
            self._clock.close()
            self._undo_quiet()
            raise CampaignError(
                f"no scheduler answers at {self.address} ({words(error)}): start one with `dask scheduler`, and say "
                "the address that it prints"
            ) from None

    def outcomes(self, jobs: Iterator[Job]) -> Iterator[Outcome]:
        """Outcomes as they come; ``jobs`` is asked again after each, also when it had none before.

        Raises CampaignError when the scheduler is gone, no worker is there, or one is not fit.
        """
        queue = JobQueue(jobs)
        try:
            while True:
                self._look()
                self._feed(queue)
                if not self._flights and not self._expects(queue):
                    return
                yield from self._wait(queue)
        finally:
            for serial in list(self._flights):
                self._drop(serial)

    def close(self) -> None:
        """Stop at once."""
        if self._closed:
            return
        self._closed = True
        for serial in list(self._flights):
            self._drop(serial)
        self._take_back()
        with suppress(Exception):
            self._client.close(timeout=1.0)
        self._clock.close()
        self._undo_quiet()

    def _take_back(self) -> None:
        """The workers forget the campaign."""
        if self._client.status == "running":
            with suppress(Exception):
                self._call(self._client._run, forget, self._name, on_error="ignore", answer_s=1.0)

    def _call(self, method: Any, *args: Any, answer_s: float = _ANSWER_S, **kwargs: Any) -> Any:
        """What a coroutine of the client says, TimeoutError where it takes too long."""
        return self._client.sync(method, *args, callback_timeout=answer_s, **kwargs)

    def _gone(self, why: str) -> CampaignError:
        return CampaignError(f"the scheduler at {self.address} is gone ({why})")

    def _hear(self, event: tuple[float, tuple[int, str]]) -> None:
        """A job has begun, or still lives."""
        serial, where = event[1]
        flight = self._flights.get(serial)
        if flight is not None:
            flight.where, flight.heard_s = where, self._clock.now()

    # ------------------------------------------------------------------------------------------------------- workers
    def _look(self) -> None:
        """Once a second: is the scheduler there, which workers are; new ones get the specification."""
        if self._closed:
            raise CampaignError("the workers were stopped while jobs were running")
        self._wait_for_scheduler()
        if time.monotonic() - self._looked_s < _LOOK_S:
            return
        self._looked_s = time.monotonic()
        try:
            self._threads = dict(self._call(self._client.scheduler.ncores))
        except (OSError, TimeoutError) as error:
            if self._client.status == "running" and not isinstance(error, TimeoutError):
                return  # it is lost, or there again, at the next look
            raise self._gone(f"it did not answer for {_ANSWER_S:g} s") from None
        self._installed &= set(self._threads)
        self._install([address for address in self._threads if address not in self._installed])
        for flight in self._flights.values():
            if flight.begun and flight.where not in self._threads:  # it waits for another worker
                flight.heard_s = float("nan")
        self._count_workers()

    def _wait_for_scheduler(self) -> None:
        """Let a lost connection come back within seconds, as the client tries to."""
        lost = time.monotonic()
        while self._client.status != "running":
            if self._client.status != "connecting" or time.monotonic() - lost > _LOST_S:
                raise self._gone("the connection was lost")
            time.sleep(SLICE_S)

    def _count_workers(self) -> None:
        now = self._clock.now()
        if self._threads:
            self._workers_seen_s = now
        elif now - self._workers_seen_s > _NO_WORKERS_S:
            raise CampaignError(
                f"the scheduler at {self.address} had no worker for {_NO_WORKERS_S:g} s: start some with "
                f"`dask worker {self.address} --nthreads 1`"
            )

    def _install(self, addresses: list[str]) -> None:
        """Give workers the specification; one without microrad, or with one too old for it, is refused."""
        if not addresses:
            return
        for address in addresses:
            try:
                self._call(
                    self._client._run, install, self._name, self._target, self._spec, self._code,
                    workers=[address],
                )  # fmt: skip
            except (OSError, TimeoutError):
                continue  # it went away, or is busy: asked again at the next look
            except Exception as error:  # what a worker cannot even read comes back as a bare Exception
                raise CampaignError(
                    f"the worker at {address} has no microrad that fits ({words(error)}); the campaign's code is "
                    f"{self._code}: install the same version there"
                ) from None
            self._installed.add(address)

    # ---------------------------------------------------------------------------------------------------------- jobs
    def _expects(self, queue: JobQueue) -> bool:
        """Whether there are jobs, and no worker for them yet."""
        job = None if self._threads else queue.next()
        if job is not None:
            queue.put_back(job)
        return job is not None

    def _feed(self, queue: JobQueue) -> None:
        """Hand out jobs: one a thread of the workers, and one that it finds when it has done its own.

        A worker gets none before it was looked at: one without microrad would end of it, and never be told.
        """
        while len(self._flights) < _AHEAD * sum(self._threads.values()):
            job = queue.next()
            if job is None:
                return
            self._serial += 1
            self._launch(self._serial, job)

    def _launch(self, serial: int, job: Job) -> None:
        self._flights[serial] = Flight(job)
        key = f"{self._topic}-{serial}"
        arguments = (self._name, self._topic, serial, tuple(job), beat_every_s(self._late_s))
        try:
            future = self._client.submit(do, *arguments, key=key, pure=False, priority=-serial)
        except Exception as error:  # as of a client that has closed
            raise self._gone(words(error)) from None
        self._futures[serial] = future
        future.add_done_callback(lambda _: self._ended.put(serial))

    def _drop(self, serial: int) -> Flight:
        """Have nothing more to do with a job under way."""
        future = self._futures.pop(serial, None)
        with suppress(Exception):
            if future.status == "pending":
                future.cancel(force=True)
        self._forgiven.discard(serial)
        return self._flights.pop(serial)

    def _again(self, serial: int, queue: JobQueue) -> None:
        queue.put_back(self._drop(serial).job)

    def _wait(self, queue: JobQueue) -> Iterator[Outcome]:
        """What happens within a slice."""
        with suppress(Empty):
            serial = self._ended.get(timeout=SLICE_S)
            if serial in self._flights:
                yield from self._task_ended(serial, queue)
        yield from self._stop_the_late()

    def _task_ended(self, serial: int, queue: JobQueue) -> Iterator[Outcome]:
        """What became of a task."""
        future = self._futures[serial]
        if future.status == "finished":
            yield from self._finished(serial, queue)
        elif future.status == "error":
            yield from self._failed(serial, future.exception(timeout=_ANSWER_S), queue)
        elif future.status in ("cancelled", "lost"):  # as where the connection was lost for a while
            self._wait_for_scheduler()
            self._again(serial, queue)

    def _finished(self, serial: int, queue: JobQueue) -> Iterator[Outcome]:
        try:
            body = self._futures[serial].result(timeout=_ANSWER_S)
        except (CancelledError, OSError, TimeoutError):  # its worker died before the result was fetched
            self._wait_for_scheduler()
            self._again(serial, queue)
            return
        kind, text = Kind(body[0]), body[1:]
        if kind is Kind.REFUSED:
            raise CampaignError(text.decode())
        if kind is Kind.OPEN:
            self._installed.discard(text.decode())
            self._looked_s = float("-inf")
            self._again(serial, queue)
            return
        job = self._drop(serial).job
        done = kind is Kind.DONE
        yield Outcome(job, "done", text) if done else Outcome(job, "raised", reason=text.decode())

    def _failed(self, serial: int, error: BaseException, queue: JobQueue) -> Iterator[Outcome]:
        """A task that gave no answer: its worker died, with it or while it waited there."""
        from distributed.scheduler import KilledWorker

        if not isinstance(error, KilledWorker):
            if isinstance(error, ImportError):
                raise CampaignError(f"a worker has no microrad that fits ({words(error)}): install it there") from None
            yield Outcome(self._drop(serial).job, "raised", reason=words(error))
            return
        flight, address = self._flights[serial], error.last_worker.address
        if serial in self._forgiven or flight.where != address:  # it had not begun there
            self._again(serial, queue)
            return
        times = error.allowed_failures + 1
        many = "" if times == 1 else f", the last of {times} that it was tried on"
        yield Outcome(self._drop(serial).job, "died", reason=f"its worker at {address} ended{many}")

    def _stop_the_late(self) -> Iterator[Outcome]:
        """Kill the workers of late jobs, to be restarted by their nannies; what else is there starts again."""
        if not late_flights(self._flights, self._clock.now(), self._late_s):
            return
        self._looked_s = float("-inf")
        self._look()  # a job is not late whose worker ended: what became of it is still to land
        late = late_flights(self._flights, self._clock.now(), self._late_s)
        flights = [self._drop(serial) for serial in late]
        addresses = {flight.where for flight in flights}
        self._forgiven |= {serial for serial, flight in self._flights.items() if flight.where in addresses}
        for address in sorted(addresses):
            self._kill(address)
        self._looked_s = float("-inf")  # those killed are to be missed, and their successors found
        for flight in flights:
            yield Outcome(flight.job, "late", reason=late_reason(self._late_s))

    def _kill(self, address: str) -> None:
        """Kill a worker through its nanny; one without a nanny is sent away by the scheduler, one unknown is gone."""
        try:
            self._call(self._client._run, kill, workers=[address], nanny=True)
        except (OSError, TimeoutError, ValueError, AttributeError, TypeError, KeyError):
            with suppress(OSError, TimeoutError):
                self._call(self._client.scheduler.retire_workers, workers=[address], close_workers=True, remove=True)
