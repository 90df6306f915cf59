"""Jobs on all cores: their order, and what is left of them after an error."""

import threading
from concurrent.futures import ThreadPoolExecutor
from functools import partial

import pytest

from microrad import threads
from microrad.threads import in_threads
from waiting import HANG_S


def test_results_come_in_the_order_of_the_jobs():
    heard, ended, over = [], [], [threading.Event() for _ in range(3)]

    def job(number):
        assert number == 2 or over[number + 1].wait(HANG_S)
        ended.append(number)
        over[number].set()
        return number

    jobs = [partial(job, number) for number in range(3)]
    assert in_threads(jobs, lambda *told: heard.append(told), workers=3) == [0, 1, 2]
    assert (ended, heard) == ([2, 1, 0], [(1, 3), (2, 3), (3, 3)])


def test_a_job_begins_while_the_next_one_is_made():
    begun = threading.Event()

    def made():
        yield lambda: begun.set() or 1
        assert begun.wait(HANG_S)
        yield lambda: 2

    assert in_threads(made(), workers=1) == [1, 2]


@pytest.mark.parametrize("where", ["in a job", "in making one"])
def test_jobs_that_have_not_begun_are_dropped_after_an_error(where, monkeypatch):
    begun, dropped = [], threading.Event()

    class Pool(ThreadPoolExecutor):
        def shutdown(self, wait=True, *, cancel_futures=False):
            super().shutdown(wait=False, cancel_futures=cancel_futures)
            dropped.set()
            super().shutdown(wait)

    def first():
        raise RuntimeError("broken")

    def other():
        begun.append(1)
        assert dropped.wait(HANG_S)

    def made():
        yield from [other] * 50
        first()

    monkeypatch.setattr(threads, "ThreadPoolExecutor", Pool)
    with pytest.raises(RuntimeError, match="broken"):
        in_threads([first, *[other] * 50] if where == "in a job" else made(), workers=1)
    assert len(begun) <= 1
