"""Jobs on all cores: their order, and what is left of them after an error."""

import threading
import time

import pytest

from microrad.threads import in_threads


def test_results_come_in_the_order_of_the_jobs():
    heard = []
    jobs = [lambda i=i: (time.sleep(0.01 * (3 - i)), i)[1] for i in range(4)]
    assert in_threads(jobs, heard.append, workers=3) == [0, 1, 2, 3]
    assert heard == [1, 2, 3, 4]


def test_jobs_that_have_not_begun_are_dropped_after_an_error():
    begun, gate = [], threading.Event()

    def first():
        gate.wait(5)
        raise RuntimeError("broken")

    def other():
        begun.append(1)
        time.sleep(0.05)

    gate.set()
    with pytest.raises(RuntimeError, match="broken"):
        in_threads([first, *[other] * 50], workers=1)
    assert len(begun) <= 2
