"""Jobs on all cores: their order, and what is left of them after an error."""

import os
import subprocess
import sys
import threading
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from types import SimpleNamespace

import pytest

from microrad.core import threads
from microrad.core.threads import beside, both, in_background, in_threads, shared_out
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


def test_jobs_that_have_not_begun_are_dropped_after_an_error(monkeypatch):
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

    monkeypatch.setattr(threads, "ThreadPoolExecutor", Pool)
    with pytest.raises(RuntimeError, match="broken"):
        in_threads([first, *[other] * 50], workers=1)
    assert len(begun) <= 1


FORKED = """
import os, sys, time
from microrad.core.threads import shared_out

def own(number):
    if os.getpid() != caller:
        {helper}
    return number, os.getpid()

caller = os.getpid()
with shared_out([lambda number=number: own(number) for number in range(40)]) as results:
    {meanwhile}
    found = results()
assert [number for number, _ in found] == list(range(40))
print(len({{pid for _, pid in found}} - {{caller}}), sum(pid != caller for _, pid in found))
"""


@pytest.mark.skipif(sys.platform != "linux" or os.cpu_count() == 1, reason="nothing is forked")
@pytest.mark.parametrize(
    ("helper", "meanwhile", "done_there"),
    [
        ("pass", "os.waitid(os.P_ALL, 0, os.WEXITED | os.WNOWAIT)", 40),  # the caller comes when all is done
        ("raise RuntimeError", "os.waitid(os.P_ALL, 0, os.WEXITED | os.WNOWAIT)", 0),
        ("os._exit(1)", "pass", 0),
        ("os.kill(os.getpid(), 9)", "pass", 0),
    ],
)
def test_forked_processes_do_jobs_and_what_they_leave_is_done_by_the_caller(helper, meanwhile, done_there):
    code = FORKED.format(helper=helper, meanwhile=meanwhile)
    ran = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert (ran.returncode, ran.stderr) == (0, "")
    assert ran.stdout.split() == [str(min(done_there, 1)), str(done_there)]


@pytest.mark.skipif(sys.platform != "linux" or os.cpu_count() == 1, reason="nothing is forked")
def test_a_process_that_dies_beside_others_is_not_waited_for():
    code = """
import multiprocessing, os
from microrad.core.threads import shared_out

sent = bytes(1 << 20)  # more than a pipe holds
os.cpu_count = lambda: 3
began, begins = os.pipe()
readied, ready = os.pipe()
told = []

def own():
    name = multiprocessing.current_process().name
    if name == "ForkProcess-1":
        os.write(begins, b".")
        os._exit(1)
    if name == "ForkProcess-2" and not told:  # it has a job, and waits until the other has begun with one
        told.append(os.read(began, 1))
        os.write(ready, b".")
    return sent

with shared_out([own] * 3) as results:
    os.read(readied, 1)
    assert results() == [sent] * 3
"""
    ran = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False, timeout=HANG_S)
    assert (ran.returncode, ran.stderr) == (0, "")


@pytest.mark.parametrize("forks", [True, False])
def test_an_error_in_a_shared_job_is_the_callers(forks, monkeypatch):
    def broken():
        raise ValueError("broken")

    monkeypatch.setattr(threads, "_may_fork", lambda: forks and sys.platform == "linux")
    with shared_out([broken, lambda: 2]) as results, pytest.raises(ValueError, match="broken"):
        results()
    assert both(lambda: 1, lambda: "two") == (1, "two")
    with beside(broken) as result, pytest.raises(ValueError, match="broken"):
        result()
    with beside(lambda: 3) as result:
        assert result() == 3


@pytest.mark.skipif(sys.platform != "linux" or os.cpu_count() == 1, reason="nothing is forked")
def test_a_job_is_done_beside_what_the_caller_does_meanwhile():
    code = """
import os
from microrad.core.threads import beside
with beside(os.getpid) as result:
    os.waitid(os.P_ALL, 0, os.WEXITED | os.WNOWAIT)
    assert result() != os.getpid()
"""
    ran = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert (ran.returncode, ran.stderr) == (0, "")


@pytest.mark.skipif(sys.platform != "linux", reason="nothing is forked")
def test_nothing_is_forked_beside_another_thread():
    code = """
import threading
from microrad.core import threads
assert threads._may_fork()
end = threading.Event()
other = threading.Thread(target=end.wait)
other.start()
assert not threads._may_fork()
end.set()
"""
    ran = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert (ran.returncode, ran.stderr) == (0, "")


ASIDE = """
import os, sys
from microrad.core.threads import in_background

def job():
    with open(sys.argv[1], "a") as file:
        file.write(str(os.getpid()))
    raise KeyboardInterrupt  # as Ctrl-C does in all processes of a terminal

in_background(job)()
assert open(sys.argv[1]).read() != str(os.getpid())
"""


@pytest.mark.skipif(sys.platform != "linux" or os.cpu_count() == 1, reason="nothing is forked")
def test_a_job_aside_is_done_in_another_process_that_says_nothing_of_its_end(tmp_path):
    ran = subprocess.run(
        [sys.executable, "-c", ASIDE, str(tmp_path / "by")], capture_output=True, text=True, check=False
    )
    assert (ran.returncode, ran.stderr) == (0, "")


def test_no_job_is_done_aside_while_other_threads_run():
    done = []
    with ThreadPoolExecutor(1) as pool:
        pool.submit(in_background, lambda: done.append(1)).result()()
    assert done == []


@pytest.mark.parametrize("cores", [1, None])
def test_nothing_is_forked_on_a_single_core_or_one_that_is_not_known(monkeypatch, cores):
    done = []
    monkeypatch.setattr(threads, "_may_fork", lambda: True)
    monkeypatch.setattr(threads.os, "cpu_count", lambda: cores)
    monkeypatch.setattr(threads.multiprocessing, "get_context", lambda kind: kind)  # nothing could start a process
    in_background(lambda: done.append(1))()
    assert done == []
    with shared_out([lambda: 1, lambda: 2]) as results:
        assert results() == [1, 2]
    assert in_threads([lambda: 1, lambda: 2]) == [1, 2]


@pytest.mark.parametrize("platform", ["darwin", "win32"])
def test_nothing_is_forked_on_another_system(monkeypatch, platform):
    monkeypatch.setattr(threads.sys, "platform", platform)
    assert not threads._may_fork()


@pytest.mark.parametrize("kind", [SystemExit, ValueError])
def test_a_process_that_helps_ends_without_a_word_and_leaves_its_job_to_the_caller(kind):
    said = []
    turns, given = os.pipe()
    os.write(given, bytes([0]))
    os.close(given)

    def job():
        raise kind

    ear = SimpleNamespace(close=lambda: said.append("ear closed"))
    threads._help([job], turns, SimpleNamespace(send=said.append), [ear])
    os.close(turns)
    assert said == ["ear closed"]
