"""Jobs on all cores: threads suffice where compiled kernels run without the interpreter lock, else forked processes."""

import contextlib
import multiprocessing
import os
import sys
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any, TypeVar

_Result = TypeVar("_Result")
_First = TypeVar("_First")
_Second = TypeVar("_Second")


def in_threads(
    jobs: Sequence[Callable[[], _Result]],
    on_done: Callable[[int, int], None] = lambda done, total: None,
    workers: int | None = None,
) -> list[_Result]:
    """What each job returns, in their order.

    After an error, or Ctrl-C, those that have not begun are dropped.

    Args:
        jobs: What to call.
        on_done: Hears how many are done, and of how many.
        workers: Number of threads; None for one on each core.
    """
    results = []
    with ThreadPoolExecutor(max_workers=workers or os.cpu_count()) as pool:
        futures = [pool.submit(job) for job in jobs]
        try:
            for done, future in enumerate(futures, 1):
                results.append(future.result())
                on_done(done, len(futures))
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise
    return results


@contextlib.contextmanager
def shared_out(
    jobs: Sequence[Callable[[], _Result]],
    on_turn: Callable[[int], None] = lambda number: None,
    *,
    meanwhile: bool = False,
) -> Iterator[Callable[[], list[_Result]]]:
    """Jobs in Python that forked processes begin with, at most 256; the callable takes part and returns their results.

    A result is pickled. A process that fails leaves its jobs to the caller, so an error is the one that the job raises
    there. Where no process can be forked the callable does all of them: that is safe on Linux alone, while no other
    thread runs.

    Args:
        jobs: What to call.
        on_turn: Hears the number of each job that the callable itself begins.
        meanwhile: Whether the caller has other work to do first: all jobs may then be done by others.
    """
    helpers = min((os.cpu_count() or 1) - 1, len(jobs) - (not meanwhile)) if _may_fork() else 0
    turns, given = os.pipe()
    os.write(given, bytes(range(len(jobs))))
    os.close(given)
    context: Any = multiprocessing.get_context("fork" if helpers else None)
    ears: list[Any] = []
    processes: list[Any] = []

    def results() -> list[_Result]:
        done = _done(jobs, turns, on_turn)
        for ear in ears:
            with contextlib.suppress(EOFError):
                done |= ear.recv()
        return [done[number] if number in done else job() for number, job in enumerate(jobs)]

    try:
        for _ in range(helpers):
            ear, mouth = context.Pipe(duplex=False)
            ears.append(ear)
            with mouth:  # closed here before the next fork: so a process that dies is heard of, whoever else lives
                process = context.Process(target=_help, args=(jobs, turns, mouth, ears), daemon=True)
                process.start()
            processes.append(process)
        yield results
    finally:
        os.close(turns)
        for process in processes:
            process.kill()
            process.join()
        for ear in ears:
            ear.close()


def both(first: Callable[[], _First], second: Callable[[], _Second]) -> tuple[_First, _Second]:
    """What two jobs in Python return, done side by side where that is possible (see `shared_out`).

    Args:
        first: The job that this process begins with.
        second: The other one.
    """
    jobs: tuple[Callable[[], Any], ...] = (first, second)
    with shared_out(jobs) as results:
        of_first, of_second = results()
    return of_first, of_second


@contextlib.contextmanager
def beside(job: Callable[[], _Result]) -> Iterator[Callable[[], _Result]]:
    """A job in Python beside what the caller does meanwhile, where that is possible; the callable returns its result.

    It is done by the callable itself where no other process has begun with it (see `shared_out`).
    """
    with shared_out([job], meanwhile=True) as results:
        yield lambda: results()[0]


def in_background(job: Callable[[], object]) -> Callable[[], None]:
    """Begin a job in a forked process beside this one; the callable waits for its end.

    What it returns, and its errors, are dropped. Where there is a single core, or no process can be forked (see
    `shared_out`), it is not done at all.
    """
    if not _may_fork() or (os.cpu_count() or 1) < 2:
        return lambda: None
    context: Any = multiprocessing.get_context("fork")
    process = context.Process(target=_quietly, args=(job,), daemon=True)
    process.start()
    return process.join  # type: ignore[no-any-return]


def _quietly(job: Callable[[], object]) -> None:
    with contextlib.suppress(BaseException):
        job()


def _may_fork() -> bool:
    return sys.platform == "linux" and len(list(Path("/proc/self/task").iterdir())) == 1


def _done(
    jobs: Sequence[Callable[[], _Result]], turns: int, on_turn: Callable[[int], None] = lambda number: None
) -> dict[int, _Result]:
    """The results of the jobs whose turns this process has taken, by number."""
    done = {}
    for (number,) in iter(lambda: os.read(turns, 1), b""):
        on_turn(number)
        done[number] = jobs[number]()
    return done


def _help(jobs: Sequence[Callable[[], Any]], turns: int, mouth: Any, ears: Sequence[Any]) -> None:
    for ear in ears:  # else nobody would tell it that the caller has gone
        ear.close()
    with contextlib.suppress(BaseException):  # the caller does without
        mouth.send(_done(jobs, turns))
