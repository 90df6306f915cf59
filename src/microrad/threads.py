"""Jobs on all cores: threads suffice, since the compiled kernels run without the interpreter lock."""

import os
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

_Result = TypeVar("_Result")


def in_threads(
    jobs: Iterable[Callable[[], _Result]],
    on_done: Callable[[int, int], None] = lambda done, total: None,
    workers: int | None = None,
) -> list[_Result]:
    """What each job returns, in their order; ``on_done`` hears how many are done, and of how many.

    A job begins as soon as ``jobs`` gives it, while the next ones may still be made on the caller's thread. After an
    error, or Ctrl-C, those that have not begun are dropped.
    """
    results = []
    with ThreadPoolExecutor(max_workers=workers or os.cpu_count()) as pool:
        try:
            futures = [pool.submit(job) for job in jobs]
            for done, future in enumerate(futures, 1):
                results.append(future.result())
                on_done(done, len(futures))
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise
    return results
