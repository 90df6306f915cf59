"""Jobs on all cores: threads suffice, since the compiled kernels run without the interpreter lock."""

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

_Result = TypeVar("_Result")


def in_threads(
    jobs: Sequence[Callable[[], _Result]],
    on_done: Callable[[int], None] = lambda done: None,
    workers: int | None = None,
) -> list[_Result]:
    """What each job returns, in their order; ``on_done`` hears how many are done.

    After an error, or Ctrl-C, those that have not begun are dropped.
    """
    results = []
    with ThreadPoolExecutor(max_workers=workers or os.cpu_count()) as pool:
        futures = [pool.submit(job) for job in jobs]
        try:
            for done, future in enumerate(futures, 1):
                results.append(future.result())
                on_done(done)
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise
    return results
