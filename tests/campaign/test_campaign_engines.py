"""The local engine: whatever a job does to its process, the others come out, and nothing is left behind."""

import asyncio
import io
import json
import logging
import math
import os
import random
import signal
import subprocess
import sys
import textwrap
import threading
import time
from itertools import islice
from queue import Empty
from types import SimpleNamespace

import psutil
import pytest

from microrad.campaign.engines import cluster, local
from microrad.campaign.engines import jobs as engine_jobs
from microrad.campaign.engines import worker as engine_worker
from microrad.campaign.engines.cluster import DaskEngine, Flight, late_flights
from microrad.campaign.engines.jobs import Clock
from microrad.campaign.engines.local import LocalEngine
from microrad.campaign.engines.worker import Beat, Kind, Message, read_message, write_message
from microrad.campaign.records import CampaignError, Job
from small_campaign import hears_ctrl_c, import_path, killing
from waiting import HANG_S, alive, beside, gone, no_hang, until

OFTEN = bool(os.environ.get("MICRORAD_ENDURANCE"))
LATE_S = 3.0  # a job that does nothing but end may be silent for half of that on a busy machine


@pytest.fixture
def engine(monkeypatch):
    """Make a local engine whose jobs do what a table by number says; closed at the end, and no process left."""
    monkeypatch.setenv("PYTHONPATH", import_path())
    made = []

    def make(table="{}", threads=2, late_s=20.0):
        made.append(LocalEngine(table.encode(), "campaign_target:open_work", threads, late_s))
        return made[-1]

    yield make
    for one in made:
        one.close()
        one.close()
    assert children() == []


def children():
    return [p for p in psutil.Process().children(recursive=True) if "microrad.campaign.engines.worker" in command(p)]


def command(process):
    """The command line of a process; of one that has just ended there is none."""
    try:
        return " ".join(process.cmdline())
    except (psutil.ZombieProcess, psutil.NoSuchProcess):
        return ""


def chunks(count, first=0):
    return [Job(0, n) for n in range(first, first + count)]


def run(engine, jobs):
    """Outcomes by number of the job; each job has one."""
    outcomes = list(engine.outcomes(iter(jobs)))
    assert sorted(o.job for o in outcomes) == sorted(jobs)
    return {o.job.number: o for o in outcomes}


def kinds(outcomes):
    return {number: o.kind for number, o in outcomes.items() if o.kind != "done"}


def test_every_job_has_its_own_result(engine):
    done = run(engine(threads=3), [Job(2, n, 7 * n, "chunk") for n in range(100)])
    assert [done[n].payload for n in range(100)] == [f"2/{n}/{7 * n}".encode() for n in range(100)]
    assert kinds(done) == {}


def test_results_do_not_depend_on_the_order_of_jobs_or_the_number_of_threads(engine):
    jobs = chunks(30)
    shuffled = random.Random(1).sample(jobs, len(jobs))
    assert shuffled != jobs
    one, other = run(engine(threads=1), jobs), run(engine(threads=4), shuffled)
    assert {n: o.payload for n, o in one.items()} == {n: o.payload for n, o in other.items()}


def test_an_engine_serves_several_calls_with_the_same_processes(engine):
    one = engine('{"else": "slow"}')
    run(one, chunks(3))
    pids = {p.pid for p in children()}
    run(one, chunks(3, first=3))
    assert {p.pid for p in children()} == pids
    assert len(pids) == 2


def test_jobs_are_taken_only_as_fast_as_they_start(engine):
    taken = []
    outcomes = engine('{"else": "slow"}', threads=2).outcomes(taken.append(j) or j for j in chunks(1000))
    for done in range(1, 11):
        next(outcomes)
        assert len(taken) <= done + 2, "two at work"
    outcomes.close()
    assert len(taken) < 20


def test_jobs_that_come_up_by_outcomes_are_taken_too(engine):
    class Growing:
        def __init__(self):
            self.jobs = chunks(2)

        def __iter__(self):
            return self

        def __next__(self):
            if not self.jobs:
                raise StopIteration
            return self.jobs.pop(0)

    jobs, numbers = Growing(), []
    for outcome in engine().outcomes(jobs):
        numbers.append(outcome.job.number)
        if outcome.job.number < 2:
            jobs.jobs.append(Job(0, outcome.job.number + 10))
    assert sorted(numbers) == [0, 1, 10, 11]


def test_an_error_is_of_its_job_alone_and_keeps_its_words(engine):
    table = '{"1": "shout", "2": "refuse", "3": "leave"}'
    outcomes = run(engine(table), chunks(6))
    assert kinds(outcomes) == {1: "raised", 2: "raised", 3: "raised"}
    assert outcomes[1].reason == "ValueError: no mirror at all"
    assert outcomes[2].reason == "row 3: no mission"
    assert outcomes[3].reason == "SystemExit: enough"


def test_what_jobs_print_does_not_disturb_the_messages(engine):
    assert kinds(run(engine('{"else": "chat"}'), chunks(20))) == {}


@pytest.mark.parametrize(
    ("deed", "words"), [("segfault", "SIGSEGV"), pytest.param("killed", "SIGKILL", marks=pytest.mark.endurance)]
)
def test_a_job_that_kills_its_process_has_died_and_the_others_come_out(engine, deed, words):
    outcomes = run(engine(f'{{"3": "{deed}"}}', threads=1), chunks(8))
    assert kinds(outcomes) == {3: "died"}, "the one that waited behind it starts again"
    assert words in outcomes[3].reason


def test_last_words_of_a_process_are_told(engine):
    outcomes = run(engine('{"0": "segfault"}', threads=1), chunks(1))
    assert "Fatal Python error: Segmentation fault" in outcomes[0].reason


def test_a_row_that_kills_takes_no_other_row_with_it(engine):
    jobs = [Job(0, n, n, "row") for n in range(4)]
    assert kinds(run(engine('{"1": "killed"}', threads=2), jobs)) == {1: "died"}


@pytest.mark.parametrize("deed", [pytest.param("hang", marks=pytest.mark.endurance), "hog"])
def test_a_job_without_a_sign_of_life_is_late(engine, deed):
    outcomes = run(engine(f'{{"2": "{deed}"}}', threads=1, late_s=LATE_S), chunks(5))
    assert kinds(outcomes) == {2: "late"}
    assert outcomes[2].reason == "gave no sign of life for 3 s and was stopped"


class ByBeats:
    """A clock that goes by the messages of the worker and not by the time: the machine may be as busy as it likes."""

    def __init__(self, step_s):
        self.step_s, self.now_s, self.own = step_s, 0.0, threading.current_thread()

    def now(self):
        if threading.current_thread() is not self.own:  # the one that hears the worker
            self.now_s += self.step_s
        return self.now_s

    def close(self):
        pass


def by_beats(one, step_s):
    one._clock.close()
    one._clock = ByBeats(step_s)
    return one


def test_neighbours_of_a_late_job_start_again_and_are_not_blamed(engine):
    one = by_beats(engine('{"0": "hang", "1": "slow 300"}', threads=2, late_s=0.5), 0.02)
    outcomes = run(one, chunks(6))
    assert kinds(outcomes) == {0: "late"}
    assert outcomes[1].payload == b"0/1/-1"


def test_a_job_that_lasts_but_beats_is_not_late(engine):
    one = by_beats(engine('{"0": "slow 150"}', late_s=0.5), 0.1)
    assert kinds(run(one, chunks(2))) == {}
    assert one._clock.now_s > 2.0


def test_a_job_that_ended_while_the_caller_did_something_else_is_not_late(engine):
    """The caller writes each outcome to a disk, which may take longer than a job may be silent."""
    one = engine(threads=2, late_s=20.0)
    one._clock.close()
    one._clock = SimpleNamespace(now=lambda: now_s[-1], close=lambda: None)
    now_s = [0.0]
    assert kinds(run(one, chunks(2))) == {} and len(children()) == 2
    outcomes = one.outcomes(iter(chunks(2, first=2)))
    first = next(outcomes)
    until(lambda: one._inbox.qsize() == 1, "the other job")
    now_s.append(1000.0)
    (second,) = outcomes
    assert (first.kind, second.kind) == ("done", "done") and first.job != second.job


def test_a_job_that_failed_once_may_be_done_again(engine, tmp_path):
    one = engine(f'{{"1": "hang_once {tmp_path}/a", "2": "killed_once {tmp_path}/b"}}', threads=1, late_s=LATE_S)
    assert kinds(run(one, chunks(4))) == {1: "late", 2: "died"}
    assert kinds(run(one, chunks(4))) == {}


def test_a_process_killed_at_random_loses_and_doubles_nothing(engine):
    jobs = 200 if OFTEN else 40
    one, todo, done, died = engine('{"else": "slow 2"}'), chunks(jobs), {}, 0

    def kill():
        for process in children():
            process.kill()

    with killing(kill, 0.05) as heard:
        while todo:
            outcomes = list(map(heard, one.outcomes(iter(todo))))
            assert sorted(o.job for o in outcomes) == todo
            done |= {o.job.number: o.payload for o in outcomes if o.kind == "done"}
            todo = sorted(o.job for o in outcomes if o.kind != "done")
            died += len(todo)
    assert done == {n: f"0/{n}/-1".encode() for n in range(jobs)}
    assert died > 0, "no kill hit a job"


def test_work_that_cannot_be_opened_is_an_error_with_its_words(engine):
    with pytest.raises(CampaignError, match=r"^mission.toml: no such mission$"):
        run(engine("refuse"), chunks(1))


def test_a_process_that_cannot_start_is_given_up(engine):
    with pytest.raises(CampaignError, match=r"ended 3 times .* exit code 3; its last words: cannot go on"):
        run(engine("die"), chunks(1))


def test_deaths_without_anything_done_between_are_given_up(engine, monkeypatch):
    assert local._DEATHS == 20
    monkeypatch.setattr(local, "_DEATHS", 3)
    with pytest.raises(CampaignError, match=r"ended 3 times without a job done between.*SIGKILL"):
        run(engine('{"else": "killed"}', threads=1), chunks(40))
    assert children() == []


@pytest.mark.parametrize("table", ["die", pytest.param('{"else": "killed"}', marks=pytest.mark.endurance)])
def test_as_many_ends_as_there_are_processes_are_not_many(engine, table, monkeypatch):
    """All may end for one reason: short of memory, or stopped by somebody."""
    monkeypatch.setattr(local, "_FALSE_STARTS", 1)
    monkeypatch.setattr(local, "_DEATHS", 1)
    with pytest.raises(CampaignError, match=f"ended {3 if table == 'die' else 4} times without a job done between"):
        run(engine(table, threads=2), chunks(40))
    assert children() == []


def test_a_process_that_something_is_written_to_is_known_by_then(engine, monkeypatch):
    """To write may take until the process reads; whoever closes the engine meanwhile has to find it."""
    one, sent, real = engine(threads=2), [], local.write_message

    def write(stream, message):
        sent.append((message.kind, stream in [worker.process.stdin for worker in one._workers]))
        real(stream, message)

    monkeypatch.setattr(local, "write_message", write)
    assert kinds(run(one, chunks(4))) == {}
    assert sorted(sent) == [(Kind.OPEN, True)] * 2 + [(Kind.JOB, True)] * 4


def test_other_code_after_a_restart_is_refused(engine, tmp_path, monkeypatch):
    one = engine(f'{{"1": "killed_once {tmp_path}/a"}}', threads=1)
    outcomes = one.outcomes(iter(chunks(4)))
    assert next(outcomes).kind == "done"
    monkeypatch.setenv("CODE_OF_TARGET", "d1ff")
    with pytest.raises(CampaignError, match="began with c0de, now it is d1ff"):
        list(outcomes)


@pytest.mark.parametrize(
    "deed", [*(pytest.param(deed, marks=pytest.mark.endurance) for deed in ("endless", "hang")), "hog"]
)
def test_close_stops_at_once_whatever_runs(engine, deed, tmp_path, monkeypatch):
    """At once: its worker is killed before anything is waited for; what it does has no end of its own."""
    one, calls = engine(f'{{"else": "{deed} {tmp_path}/begun", "0": "work"}}'), []
    outcomes = one.outcomes(iter(chunks(10)))
    assert next(outcomes).kind == "done"
    until((tmp_path / "begun").exists, "the deed")
    for name in ("kill", "wait"):
        monkeypatch.setattr(subprocess.Popen, name, noted(calls, name, getattr(subprocess.Popen, name)))
    with no_hang():
        one.close()
    assert calls[:2] == ["kill", "wait"]
    assert children() == []


def noted(calls, name, real):
    def call(*args, **kwargs):
        calls.append(name)
        return real(*args, **kwargs)

    return call


def test_a_closed_engine_starts_nothing_more(engine, tmp_path):
    one = engine(f'{{"else": "endless {tmp_path}/begun"}}')
    closer = beside(lambda: (until((tmp_path / "begun").exists, "the first job"), one.close()))
    with no_hang(), pytest.raises(CampaignError, match="were stopped while jobs were running"):
        list(one.outcomes(iter(chunks(100))))
    closer.join(HANG_S)
    assert children() == []


def test_a_caller_that_goes_away_leaves_nothing_running(engine):
    one = engine('{"else": "endless", "0": "work"}')
    with no_hang():
        list(islice(one.outcomes(iter(chunks(10))), 1))
    assert children() == []
    assert kinds(run(one, [Job(0, 0)])) == {}


# ------------------------------------------------------------------------------------------- the parent's own end
PARENT = """
import sys
from microrad.campaign.engines.local import LocalEngine
from microrad.campaign.records import Job
engine = LocalEngine(sys.argv[1].encode(), "campaign_target:open_work", 2, float(sys.argv[2]))
try:
    for outcome in engine.outcomes(Job(0, n) for n in range(int(sys.argv[3]))):
        print(outcome.kind, flush=True)
except KeyboardInterrupt:
    engine.close()
    print("stopped", flush=True)
"""


@pytest.fixture
def parent():
    """Start a process that runs an engine with a table of jobs; returns it and its workers when two jobs are done."""
    started = []

    def start(table, late_s=1000.0, jobs=10000):
        process = subprocess.Popen(
            [sys.executable, "-c", PARENT, table, str(late_s), str(jobs)],
            env=os.environ | {"PYTHONPATH": import_path()},
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            start_new_session=True,
            preexec_fn=hears_ctrl_c,  # noqa: PLW1509
        )
        started.append(process)
        alarm = threading.Timer(HANG_S, process.kill)
        alarm.start()
        assert [process.stdout.readline() for _ in range(2)] == ["done\n"] * 2
        alarm.cancel()
        return process, psutil.Process(process.pid).children()

    yield start
    for process in started:
        process.kill()
        process.communicate()


FINE = '{"0": "work", "1": "work"'


@pytest.mark.parametrize("deed", ["endless", pytest.param("hang", marks=pytest.mark.endurance), "hog"])
def test_a_killed_parent_leaves_no_orphan(parent, deed, tmp_path):
    process, workers = parent(f'{FINE}, "else": "{deed} {tmp_path}/begun"}}')
    until((tmp_path / "begun").exists, "the deed")
    assert workers and all(alive(worker.pid) for worker in workers)
    process.kill()
    assert gone(*(worker.pid for worker in workers))


def test_ctrl_c_stops_what_has_no_end_and_leaves_no_orphan(parent, tmp_path):
    process, workers = parent(f'{FINE}, "else": "hog {tmp_path}/begun"}}')
    until((tmp_path / "begun").exists, "the deed")
    os.killpg(process.pid, signal.SIGINT)  # as a terminal does: to parent and worker
    assert process.communicate(timeout=HANG_S) == ("stopped\n", "")
    assert workers and not any(worker.is_running() for worker in workers)


@pytest.mark.parametrize(("deed", "late_s", "late"), [("quiet", 500.0, {}), ("hang", LATE_S, {2: "late"})])
def test_a_campaign_stopped_for_a_while_calls_only_that_late_which_is(
    engine, deed, late_s, late, tmp_path, monkeypatch
):
    """The engine's process sees no more of a halt than that the clock has gone on meanwhile: here for 1000 s."""
    begun, end, looks = tmp_path / "begun", tmp_path / "end", []

    def monotonic():
        looks.append(1)
        return time.monotonic() + 1000.0 * begun.exists()

    def halt():
        until(begun.exists, "job 2")
        workers = children() if deed == "quiet" else ()  # what hangs is not resumed, nor would be one that begins
        for worker in workers:
            worker.suspend()
        count = len(looks)
        until(lambda: len(looks) > count + 10, "some seconds awake behind the halt")
        for worker in workers:
            worker.resume()
        end.touch()

    monkeypatch.setattr(engine_jobs, "time", SimpleNamespace(monotonic=monotonic))
    own = f" {end}" if deed == "quiet" else ""
    one = engine(f'{{"2": "{deed} {begun}{own}"}}', late_s=late_s)
    halted = beside(halt)
    with no_hang():
        assert kinds(run(one, chunks(10))) == late
    halted.join(HANG_S)


def in_another_process(code, tmp_path):
    return subprocess.run(
        [sys.executable, "-c", textwrap.dedent(code)],
        cwd=tmp_path, capture_output=True, text=True, timeout=HANG_S, check=False,
    )  # fmt: skip


def test_a_process_stuck_in_code_that_keeps_the_lock_ends_by_itself(tmp_path):
    code = """
        import ctypes
        from microrad.campaign.engines.worker import end_when_stuck
        end_when_stuck(0.5)
        ctypes.PyDLL(None).sleep(86400)
    """
    stuck = in_another_process(code, tmp_path)
    assert stuck.returncode == 1
    assert "Timeout" in stuck.stderr


def test_the_alarm_of_a_process_that_is_not_stuck_is_wound_again_before_it_rings(tmp_path):
    code = """
        import ctypes, faulthandler, time
        from microrad.campaign.engines.worker import end_when_stuck
        wound, slept, sleep = [], [], time.sleep
        faulthandler.dump_traceback_later = lambda after_s, exit: wound.append((after_s, exit))
        time.sleep = lambda seconds: (slept.append(seconds), sleep(0.001))
        end_when_stuck(0.5)
        while len(wound) < 20:
            ctypes.CDLL(None).usleep(1000)
        assert set(wound) == {(0.5, True)}
        assert set(slept) == {0.1}
    """
    free = in_another_process(code, tmp_path)
    assert (free.returncode, free.stderr) == (0, "")


# ------------------------------------------------------------------------------------------------- the small parts
def test_late_flights_are_those_silent_for_too_long_and_their_silent_neighbours():
    flights = {k: Flight(Job(0, k), heard) for k, heard in enumerate([10.0, 14.9, 16.0, float("nan")])}
    assert late_flights(flights, now_s=19.0, late_s=10.0) == []
    assert late_flights(flights, now_s=20.5, late_s=10.0) == [0, 1]


def test_beats_are_told_at_once_and_then_not_too_often():
    told = []
    beat = Beat(lambda: told.append(1), every_s=3600.0)
    beat()
    beat()
    assert len(told) == 1
    often = Beat(lambda: told.append(1), every_s=0.0)
    often()
    often()
    assert len(told) == 3


def test_a_clock_counts_seconds_awake(monkeypatch):
    times = iter([5.0, 5.1, 5.25, 1005.25, 1005.3])  # a halt of 1000 s is in it
    monkeypatch.setattr(engine_jobs, "time", SimpleNamespace(monotonic=lambda: next(times, 1005.3)))
    clock = Clock()
    until(lambda: clock.now() > 0.49, "the last of these times")
    clock.close()
    assert clock.now() == pytest.approx(0.1 + 0.15 + 0.2 + 0.05)


def test_a_job_that_is_done_begins_the_count_of_deaths_anew(engine, monkeypatch):
    monkeypatch.setattr(local, "_DEATHS", 4)
    killed = {str(number): "killed" for number in range(0, 15, 3)}  # each takes its process down, twice at most
    outcomes = run(engine(json.dumps(killed), threads=1), chunks(15))
    assert set(kinds(outcomes)) == set(map(int, killed))


def test_a_message_that_ends_early_is_none():
    whole = io.BytesIO()
    write_message(whole, Message(Kind.BEAT, b"twelve bytes"))
    for size in range(len(whole.getvalue())):
        assert read_message(io.BytesIO(whole.getvalue()[:size])) is None
    assert read_message(io.BytesIO(whole.getvalue())) == Message(Kind.BEAT, b"twelve bytes")


# -------------------------------------------------------------------------------------------- decisions, one by one
@pytest.mark.parametrize(
    ("silent_s", "late"),
    [
        ([10.0, 6.0], []),  # as long as may be
        ([10.1, 5.0], [0]),  # the neighbour half as long
        ([10.1, 5.1], [0, 1]),
        ([5.1, 10.1, 4.9], [0, 1]),
        ([9.9, 9.9], []),
    ],
)
def test_a_flight_is_late_beyond_its_time_and_a_neighbour_beyond_half_of_it(silent_s, late):
    flights = {k: Flight(Job(0, k), 100.0 - silent) for k, silent in enumerate(silent_s)}
    flights[9] = Flight(Job(0, 9))  # it waits
    assert late_flights(flights, 100.0, 10.0) == late
    assert late_flights({}, 100.0, 10.0) == late_flights({9: flights[9]}, 100.0, 10.0) == []


@pytest.mark.parametrize(
    ("code", "words"),
    [
        (0, "ended with exit code 0"),
        (3, "ended with exit code 3"),
        (-int(signal.SIGKILL), "was ended by SIGKILL (if nobody stopped it, the machine ran out of memory)"),
        (-int(signal.SIGTERM), "was ended by SIGTERM"),
        (-1000, "was ended by signal 1000"),
    ],
)
def test_the_end_of_a_process_in_words(code, words):
    assert local._exit_words(code) == words


@pytest.mark.parametrize(
    ("lines", "said"),
    [
        ([], ""),
        ([" ", ""], ""),
        (["a", " b ", "", "c"], "a / b / c"),
        (["1", "2", "3", "4", "5"], "2 / 3 / 4 / 5"),  # the last four
        (["0", "Fatal Python error: x", "2", "3", "4", "5", "6"], "Fatal Python error: x / 2 / 3 / 4"),
        (["Fatal Python error: x", "2", "3", "4", "5", "6"], "Fatal Python error: x / 2 / 3 / 4"),
    ],
)
def test_the_last_words_of_a_process_are_its_last_lines_or_those_of_its_crash(lines, said):
    worker = SimpleNamespace(_lines=lines, process=SimpleNamespace(returncode=1))
    words = local._WorkerProcess.ending(worker)
    assert words == "ended with exit code 1" + (f"; its last words: {said}" if said else "")


def a_worker(job=None, *, ready=True, begun=True, heard_s=0.0, code=-9):
    """A worker process that is none."""
    made = object.__new__(local._WorkerProcess)
    made.job, made.ready, made.begun, made.heard_s = job, ready, begun, heard_s
    made.process, made._lines = SimpleNamespace(returncode=code), []
    made.kill = lambda: None
    return made


class Queue(list):
    """Jobs that are put back."""

    put_back = list.append


def an_engine(*workers, processes=2, late_s=10.0, now_s=0.0):
    """An engine of such workers, at a time of its clock."""
    made = object.__new__(LocalEngine)
    made._workers, made._processes, made._late_s, made._code = list(workers), processes, late_s, ""
    made._deaths = made._false_starts = 0
    made._clock, made._closed = SimpleNamespace(now=lambda: now_s), False
    return made


@pytest.mark.parametrize(
    ("ready", "silent_s", "late"),
    [(True, 10.0, False), (True, 10.1, True), (False, 10.1, False), (False, 300.0, False), (False, 300.1, True)],
)
def test_a_worker_has_longer_to_start_than_a_job_to_show_a_sign_of_life(ready, silent_s, late):
    worker, idle = a_worker(Job(0, 1), ready=ready), a_worker(None)
    engine, queue = an_engine(worker, idle, now_s=silent_s), Queue()
    outcomes = list(engine._stop_the_late(queue))
    assert [(each.kind, each.reason) for each in outcomes] == [
        ("late", "gave no sign of life for 10 s and was stopped")
    ] * late
    assert engine._workers == ([idle] if late else [worker, idle])
    assert queue == []


def test_a_job_that_had_not_begun_when_its_worker_ended_starts_again():
    job, queue = Job(0, 1), Queue()

    def lost(worker):
        return list(an_engine(worker)._lost(worker, queue, "died"))

    assert lost(a_worker(job, begun=False)) == []
    assert queue == [job]
    queue.clear()
    (died,) = lost(a_worker(job))
    assert (died.job, died.kind) == (job, "died") and died.reason.startswith("its worker process was ended by SIGKILL")
    assert lost(a_worker(None)) == [] and queue == []


@pytest.mark.parametrize(
    ("processes", "ready", "code", "ends"),
    [
        (1, False, 1, 3),  # it ends by itself before it can work
        (3, False, 0, 4),  # all may end for one reason
        (1, False, -9, 20),  # killed
        (1, True, 1, 20),
        (11, True, 1, 22),
    ],
)
def test_an_engine_gives_up_after_so_many_ends_in_a_row(processes, ready, code, ends):
    engine, queue = an_engine(processes=processes), Queue()
    for _ in range(ends - 1):
        list(engine._lost(a_worker(ready=ready, code=code), queue, "died"))
    with pytest.raises(CampaignError, match=f"worker processes ended {ends} times without a job done between"):
        list(engine._lost(a_worker(ready=ready, code=code), queue, "died"))


def test_messages_mean_what_they_say_and_those_of_a_stopped_worker_nothing():
    job, queue = Job(0, 1), Queue()
    worker, stopped = a_worker(job, ready=False), a_worker(Job(0, 2))
    engine = an_engine(worker)
    engine._deaths, engine._false_starts = 5, 2
    assert (
        list(engine._take(stopped, Message(Kind.DONE, b"x"), queue)) == list(engine._take(stopped, None, queue)) == []
    )
    assert list(engine._take(worker, Message(Kind.READY, b"code"), queue)) == []
    assert (worker.ready, engine._code, engine._deaths) == (True, "code", 5)
    (done,) = engine._take(worker, Message(Kind.DONE, b"result"), queue)
    assert (done.job, done.kind, done.payload, done.reason) == (job, "done", b"result", "")
    assert (worker.job, engine._deaths, engine._false_starts) == (None, 0, 0)
    assert list(engine._take(worker, Message(Kind.DONE, b"again"), queue)) == []  # it has no job
    worker.job = job
    (raised,) = engine._take(worker, Message(Kind.RAISED, b"why"), queue)
    assert (raised.kind, raised.payload, raised.reason) == ("raised", b"", "why")
    with pytest.raises(CampaignError, match="not to be opened"):
        list(engine._take(worker, Message(Kind.REFUSED, b"not to be opened"), queue))
    with pytest.raises(CampaignError, match="it began with code, now it is other"):
        list(engine._take(worker, Message(Kind.READY, b"other"), queue))
    worker.job = job
    (died,) = engine._take(worker, None, queue)
    assert (died.kind, engine._workers) == ("died", [])


def a_cluster(**changes):
    """The engine of a cluster without any, at second 100 of its clock."""
    made = object.__new__(DaskEngine)
    given = {
        "address": "tcp://here", "_late_s": 10.0, "_flights": {}, "_futures": {}, "_forgiven": set(), "_threads": {},
        "_installed": set(), "_looked_s": -math.inf, "_closed": False, "_workers_seen_s": 0.0,
        "_clock": SimpleNamespace(now=lambda: 100.0), "_name": "work", "_topic": "topic",
        "_client": SimpleNamespace(status="running", scheduler=SimpleNamespace(ncores="ncores")),
    }  # fmt: skip
    for name, value in (given | changes).items():
        setattr(made, name, value)
    return made


@pytest.mark.parametrize(("seen_s", "told"), [(40.0, False), (39.9, True)])
def test_a_minute_without_workers_counts_from_the_last_that_was_seen(seen_s, told):
    engine = a_cluster(_workers_seen_s=seen_s)
    if told:
        with pytest.raises(CampaignError, match="had no worker for 60 s"):
            engine._count_workers()
    else:
        engine._count_workers()
    there = a_cluster(_threads={"a": 1}, _workers_seen_s=0.0)
    there._count_workers()
    assert there._workers_seen_s == 100.0


def test_a_look_installs_what_is_new_and_forgets_what_is_gone():
    engine = a_cluster(_installed={"old", "gone"})
    engine._flights = {1: Flight(Job(0, 1), 90.0, "gone"), 2: Flight(Job(0, 2), 90.0, "old"), 3: Flight(Job(0, 3))}
    given = []
    engine._call = lambda what, *args, **options: {"old": 2, "new": 1}
    engine._install = given.append
    engine._look()
    assert (engine._threads, given, engine._installed) == ({"old": 2, "new": 1}, [["new"]], {"old"})
    assert [flight.begun for flight in engine._flights.values()] == [False, True, False]
    engine._call = lambda what, *args, **options: {}
    engine._look()  # within a second of the last look: not asked
    assert engine._threads == {"old": 2, "new": 1}
    engine._closed = True
    with pytest.raises(CampaignError, match="the workers were stopped"):
        engine._look()


@pytest.mark.parametrize(
    ("error", "status", "told"),
    [(OSError(), "running", False), (TimeoutError(), "running", True), (OSError(), "closed", True)],
)
def test_a_scheduler_that_does_not_answer_is_gone_and_one_whose_call_broke_is_asked_again(error, status, told):
    engine = a_cluster()

    def call(*args, **options):
        engine._client.status = status
        raise error

    engine._call = call
    if told:
        with pytest.raises(CampaignError, match=r"the scheduler at tcp://here is gone \(it did not answer for 20 s\)"):
            engine._look()
    else:
        engine._look()
    assert engine._threads == {}


def test_the_neighbours_of_a_late_job_are_forgiven_where_they_ran_and_nowhere_else():
    engine, killed = a_cluster(), []
    engine._flights = {
        1: Flight(Job(0, 1), 80.0, "here"),
        2: Flight(Job(0, 2), 99.0, "here"),
        3: Flight(Job(0, 3), 99.0, "there"),
        4: Flight(Job(0, 4)),
    }
    engine._futures = {k: SimpleNamespace(status="finished") for k in engine._flights}
    engine._look = lambda: None
    engine._kill = killed.append
    (late,) = engine._stop_the_late()
    assert (late.job, late.kind, late.reason) == (Job(0, 1), "late", "gave no sign of life for 10 s and was stopped")
    assert (killed, engine._forgiven, list(engine._flights)) == (["here"], {2}, [2, 3, 4])
    assert engine._looked_s == -math.inf
    assert list(engine._stop_the_late()) == [] and killed == ["here"]


def test_a_sign_of_life_is_that_of_a_job_under_way():
    engine = a_cluster(_flights={1: Flight(Job(0, 1))})
    engine._hear((0.0, (1, "here")))
    engine._hear((0.0, (2, "there")))
    assert engine._flights == {1: Flight(Job(0, 1), 100.0, "here")}


@pytest.mark.parametrize(("threads", "under_way"), [({}, 0), ({"a": 1}, 2), ({"a": 1, "b": 2}, 6)])
def test_two_jobs_a_thread_are_under_way(threads, under_way):
    engine = a_cluster(_threads=threads, _serial=0)
    launched = []

    def launch(serial, job):
        engine._flights[serial] = Flight(job)
        launched.append(serial)

    engine._launch = launch
    engine._feed(engine_jobs.JobQueue(Job(0, k) for k in range(100)))
    assert launched == list(range(1, under_way + 1))
    few = a_cluster(_threads={"a": 4}, _serial=0)
    few._launch = lambda serial, job: few._flights.update({serial: Flight(job)})
    few._feed(engine_jobs.JobQueue(Job(0, k) for k in range(3)))
    assert len(few._flights) == 3


def test_a_job_put_back_is_the_next_and_its_iterator_is_asked_again():
    more = []
    queue = engine_jobs.JobQueue(iter(lambda: more.pop(0) if more else None, "never"))
    assert queue.next() is None
    more += [Job(0, 1), Job(0, 2)]
    assert queue.next() == Job(0, 1)
    queue.put_back(Job(0, 7))
    queue.put_back(Job(0, 8))
    assert [queue.next() for _ in range(4)] == [Job(0, 8), Job(0, 7), Job(0, 2), None]


def two_flights(status="finished", body=b"", **changes):
    """A cluster's engine with two jobs under way in two cells, the second of which has ended like that."""
    asked = []
    ended = SimpleNamespace(status=status, result=lambda timeout: body)
    ended.cancel = lambda **options: asked.append(options["force"])
    engine = a_cluster(_forgiven={1, 2}, _installed={"tcp://a", "tcp://b"}, _looked_s=7.0, **changes)
    engine._flights = {1: Flight(Job(3, 5), 99.0, "tcp://a"), 2: Flight(Job(4, 6, 9, "row"), 98.0, "tcp://b")}
    engine._futures = {1: SimpleNamespace(status="pending"), 2: ended}
    return engine, asked


@pytest.mark.parametrize(
    ("kind", "body", "outcome", "again", "installed"),
    [
        (Kind.DONE, b"\x04\xff", ("done", b"\x04\xff", ""), False, "ab"),
        (Kind.DONE, b"", ("done", b"", ""), False, "ab"),
        (Kind.RAISED, "no µrad".encode(), ("raised", b"", "no µrad"), False, "ab"),
        (Kind.OPEN, b"tcp://b", None, True, "a"),
        (Kind.OPEN, b"tcp://c", None, True, "ab"),
    ],
)
def test_an_answer_of_a_worker_is_that_of_its_own_job(kind, body, outcome, again, installed):
    engine, asked = two_flights(body=bytes([kind]) + body)
    queue = engine_jobs.JobQueue(iter(()))
    found = list(engine._task_ended(2, queue))
    assert [(each.job, each.kind, each.payload, each.reason) for each in found] == (
        [(Job(4, 6, 9, "row"), *outcome)] if outcome else []
    )
    assert (list(engine._flights), list(engine._futures), engine._forgiven, asked) == ([1], [1], {1}, [])
    assert queue.next() == (Job(4, 6, 9, "row") if again else None)
    assert engine._installed == {f"tcp://{each}" for each in installed}
    assert engine._looked_s == (-math.inf if again else 7.0), "the worker gets it at the next look, which is at once"


@pytest.mark.parametrize(("status", "again"), [("cancelled", True), ("lost", True), ("pending", False)])
def test_a_task_without_an_end_of_its_own_starts_again_and_one_under_way_goes_on(status, again):
    engine, _ = two_flights(status)
    queue = engine_jobs.JobQueue(iter(()))
    assert list(engine._task_ended(2, queue)) == []
    assert list(engine._flights) == ([1] if again else [1, 2])
    assert queue.next() == (Job(4, 6, 9, "row") if again else None)


@pytest.mark.parametrize("status", ["pending", "finished"])
def test_a_job_that_is_dropped_is_taken_back_where_it_is_still_to_come(status):
    engine, asked = two_flights(status)
    assert engine._drop(2) == Flight(Job(4, 6, 9, "row"), 98.0, "tcp://b")
    assert asked == [True] * (status == "pending")
    engine._futures[1].cancel = lambda force: 1 / 0
    assert engine._drop(1).job == Job(3, 5)
    assert (engine._flights, engine._futures, engine._forgiven) == ({}, {}, set())


def test_a_job_goes_to_a_cluster_by_its_numbers_under_its_own_key_and_in_its_order():
    engine, sent, called = a_cluster(_ended=[]), [], []
    engine._ended = SimpleNamespace(put=called.append)
    future = SimpleNamespace(add_done_callback=lambda call: call("future"))
    engine._client.submit = lambda *args, **options: (sent.append((args, options)), future)[1]
    engine._launch(5, Job(1, 2, 3, "trace"))
    arguments = (cluster.do, "work", "topic", 5, (1, 2, 3, "trace"), 1.0)  # a tenth of what is late
    assert sent == [(arguments, {"key": "topic-5", "pure": False, "priority": -5})]
    assert (engine._flights, engine._futures, called) == ({5: Flight(Job(1, 2, 3, "trace"))}, {5: future}, [5])
    assert not engine._flights[5].begun


def test_each_new_worker_gets_the_specification_and_one_that_is_busy_is_asked_again():
    engine, asked = a_cluster(_target="m:f", _spec=b"spec", _code="c0de", _installed={"old"}), []

    def call(what, *args, workers):
        asked.append((what, *args, *workers))
        if workers != ["b"]:
            raise {"a": OSError, "c": TimeoutError, "d": ModuleNotFoundError}[workers[0]]("no module\nmicrorad")

    engine._call, engine._client._run = call, "run"
    engine._install([])
    engine._install(["a", "b", "c"])
    assert asked == [("run", cluster.install, "work", "m:f", b"spec", "c0de", each) for each in "abc"]
    assert engine._installed == {"old", "b"}
    with pytest.raises(CampaignError) as told:
        engine._install(["b", "d"])
    assert str(told.value) == (
        "the worker at d has no microrad that fits (ModuleNotFoundError: no module microrad); the campaign's code is "
        "c0de: install the same version there"
    )


@pytest.mark.parametrize(("threads", "jobs", "expects"), [({}, 1, True), ({}, 0, False), ({"a": 1}, 1, False)])
def test_jobs_are_waited_with_as_long_as_there_are_no_workers(threads, jobs, expects):
    queue = engine_jobs.JobQueue(Job(0, k) for k in range(jobs))
    assert a_cluster(_threads=threads)._expects(queue) is expects
    assert queue.next() == (Job(0, 0) if jobs else None), "it is still to come"


@pytest.mark.parametrize(
    ("states", "told"),
    [
        (["running"], False),
        (["connecting", "connecting", "running"], False),
        (["connecting", "closed"], True),
        (["connecting"] * 60, True),
    ],
)
def test_a_connection_may_come_back_within_seconds(monkeypatch, states, told):
    seconds = iter(range(1000))
    clock = SimpleNamespace(monotonic=lambda: 0.1 * next(seconds), sleep=lambda s: None)
    monkeypatch.setattr(cluster, "time", clock)

    class Client(list):
        status = property(lambda self: self.pop(0) if len(self) > 1 else self[0])

    engine = a_cluster(_client=Client(state for state in states for _ in range(2)))  # read twice a turn
    if told:
        with pytest.raises(CampaignError, match=r"^the scheduler at tcp://here is gone \(the connection was lost\)$"):
            engine._wait_for_scheduler()
        assert next(seconds) < 54
    else:
        engine._wait_for_scheduler()


def test_the_workers_forget_a_campaign_once_where_the_scheduler_is_there():
    engine, asked = two_flights("pending")
    engine._call = lambda *args, **options: asked.append((args, options))
    engine._client._run, engine._undo_quiet = "run", lambda: asked.append("undone")
    engine._client.close = lambda **options: asked.append(options["timeout"])
    engine._clock.close = lambda: asked.append("clock")
    engine._futures[1].cancel = lambda force: 1 / 0
    engine.close()
    engine.close()
    forgets = (("run", cluster.forget, "work"), {"on_error": "ignore", "answer_s": 1.0})
    assert asked == [True, forgets, 1.0, "clock", "undone"]
    assert engine._flights == {}
    engine._client.status = "closed"
    engine._take_back()
    assert len(asked) == 5
    engine._client.status, engine._call = "running", lambda *args, **options: 1 / 0
    engine._take_back()


def test_late_jobs_of_two_workers_stop_both_in_their_order():
    engine, killed = a_cluster(_flights={}, _forgiven={9}), []
    places = enumerate(["z", "a", "m", "z", "a"], 3)
    heard = {3: 80.0, 4: 81.0, 5: 99.0, 6: 97.0, 7: 98.5}
    engine._flights = {k: Flight(Job(k, 2 * k), heard[k], where) for k, where in places}
    engine._futures = {k: SimpleNamespace(status="finished") for k in engine._flights}
    engine._look, engine._kill = (lambda: None), killed.append
    found = [(each.job, each.kind, each.reason) for each in engine._stop_the_late()]
    assert found == [(Job(k, 2 * k), "late", "gave no sign of life for 10 s and was stopped") for k in (3, 4)]
    assert (killed, engine._forgiven, list(engine._flights)) == (["a", "z"], {6, 7, 9}, [5, 6, 7])


def test_a_specification_is_opened_once_and_kept_by_its_first_name(monkeypatch):
    opened = []
    monkeypatch.setattr(cluster, "_openings", {})
    monkeypatch.setattr(cluster, "open_target", lambda target, spec: opened.append((target, spec)) or "work")
    monkeypatch.setattr(cluster, "code_sha256", lambda target: f"of {target}")
    cluster.install("one", "m:f", b"1", "of m:f")
    cluster.install("two", "m:g", b"2", "of m:f")
    cluster.install("one", "m:h", b"3", "other")
    one, two = cluster._openings["one"], cluster._openings["two"]
    assert [one.opened(), one.opened(), opened] == ["work", "work", [("m:f", b"1")]]
    with pytest.raises(CampaignError, match=r"^runs other code of microrad: of m:g, where the campaign's is of m:f$"):
        two.opened()
    cluster.forget("two")
    cluster.forget("two")
    assert (one.stopped, two.stopped, list(cluster._openings)) == (False, True, ["one"])


@pytest.mark.parametrize(
    ("error", "words"),
    [
        (CampaignError("a\n  b"), "a b"),
        (ValueError("a\n\n b\tc"), "ValueError: a b c"),
        (KeyError(), "KeyError"),
        (CampaignError(""), ""),
        (OSError(28, "No space left"), "OSError: [Errno 28] No space left"),
        (ValueError("x" * 1200), "ValueError: " + "x" * 1000),
    ],
)
def test_an_error_is_one_line_of_words(error, words):
    assert engine_worker.words(error) == words


def test_a_sign_of_life_is_told_again_when_its_time_is_over(monkeypatch):
    times, told = iter([5.0, 6.9, 7.0, 8.9, 10.5, 12.4, 12.5]), []

    def times_now():
        told.append(next(times))
        return told[-1]

    monkeypatch.setattr(engine_worker, "time", SimpleNamespace(monotonic=times_now))
    heard, beat = [], Beat(lambda: heard.append(told[-1]), every_s=2.0)
    for _ in range(7):
        beat()
    assert heard == [5.0, 7.0, 10.5, 12.5]


class Asked(list):
    """Messages for a worker; it ends behind the last."""

    def get(self):
        if not self:
            raise SystemExit
        return self.pop(0)


def served(monkeypatch, *bodies, target="campaign_target:open_work", late_s=10.0):
    """What a worker says to the specification and to each job."""
    said = io.BytesIO()
    monkeypatch.setenv("CODE_OF_TARGET", "abc")
    messages = Asked(
        [Message(Kind.OPEN, bodies[0]), *(Message(Kind.JOB, json.dumps(job).encode()) for job in bodies[1:])]
    )
    try:
        engine_worker._serve(target, late_s, messages, said)
    except SystemExit:
        assert messages == []
    said.seek(0)
    return [(each.kind.name, each.body) for each in iter(lambda: read_message(said), None)]


@pytest.mark.parametrize(
    ("spec", "target", "words"),
    [
        (b"refuse", "campaign_target:open_work", b"mission.toml: no such mission"),
        (b"{}", "campaign_target:none", b"AttributeError: module 'campaign_target' has no attribute 'none'"),
        (b"{}", "no_such:f", b"ModuleNotFoundError: No module named 'no_such'"),
    ],
)
def test_a_worker_that_cannot_open_its_work_says_why_and_ends(monkeypatch, spec, target, words):
    assert served(monkeypatch, spec, [0, 1], target=target) == [("REFUSED", words)]


def test_a_worker_does_job_after_job_whatever_becomes_of_one(monkeypatch):
    spec = b'{"2": "shout", "3": "refuse", "4": "leave"}'
    jobs = [[7, 1, 5, "row"], *([1, k] for k in (2, 3, 4)), [8, 6]]
    assert served(monkeypatch, spec, *jobs) == [
        ("READY", b"abc"),
        ("BEAT", b""), ("DONE", b"7/1/5"),
        ("BEAT", b""), ("RAISED", b"ValueError: no mirror at all"),
        ("BEAT", b""), ("RAISED", b"row 3: no mission"),
        ("BEAT", b""), ("RAISED", b"SystemExit: enough"),
        ("BEAT", b""), ("DONE", b"8/6/-1"),
    ]  # fmt: skip


def test_a_process_is_heard_by_each_message_and_its_signs_of_life_stay_with_it():
    stream, inbox = io.BytesIO(), []
    for kind, body in [(Kind.READY, b"code"), (Kind.BEAT, b""), (Kind.DONE, b"\x00"), (Kind.RAISED, b"why")]:
        write_message(stream, Message(kind, body))
    stream.write(b"\x05cut")
    stream.seek(0)
    seconds = iter([3.0, 5.0, 7.0, 9.0])
    process = a_worker(begun=False)
    process.process.stdout = stream
    process._clock, process._inbox = SimpleNamespace(now=lambda: next(seconds)), SimpleNamespace(put=inbox.append)
    process._listen()
    assert [(each is process, said and (said.kind.name, said.body)) for each, said in inbox] == [
        (True, ("READY", b"code")), (True, ("DONE", b"\x00")), (True, ("RAISED", b"why")), (True, None)
    ]  # fmt: skip
    assert (process.begun, process.heard_s, stream.closed) == (True, 9.0, True)
    process.process.stderr = io.BytesIO(b"first \n\n  caf\xe9\r\nlast")
    process._keep_lines()
    assert process._lines == ["first", "", "  caf\ufffd", "last"]


def test_a_job_begins_unheard_and_one_whose_process_has_ended_is_sent_all_the_same():
    process = a_worker(begun=True, heard_s=1.0)
    process.process.stdin, process._clock = io.BytesIO(), SimpleNamespace(now=lambda: 33.0)
    process.open(b"spec")
    process.begin(Job(1, 2, 3, "trace"))
    process.process.stdin.seek(0)
    opened, job = read_message(process.process.stdin), read_message(process.process.stdin)
    assert (opened, job.kind, json.loads(job.body)) == ((Kind.OPEN, b"spec"), Kind.JOB, [1, 2, 3, "trace"])
    assert (process.job, process.begun, process.heard_s) == (Job(1, 2, 3, "trace"), False, 33.0)

    def broken(data):
        raise BrokenPipeError

    process.process.stdin = SimpleNamespace(write=broken)
    process.begin(Job(4, 5))
    assert process.job == Job(4, 5)


def test_what_an_engine_ended_with_is_told_with_the_count_and_the_last_words():
    process = a_worker(Job(0, 1), ready=False, code=3)
    process._lines = ["a", "ImportError: no numpy"]
    engine = an_engine(process, processes=1)
    engine._deaths, engine._false_starts = 4, 2
    with pytest.raises(CampaignError) as told:
        list(engine._lost(process, Queue(), "died"))
    assert str(told.value) == (
        "worker processes ended 5 times without a job done between; the last ended with exit code 3; its last words: "
        "a / ImportError: no numpy"
    )


def test_other_loggers_and_levels_are_left_by_what_silences_the_cluster():
    names = ["distributed.test", "distributed.test.core", "undistributed", "dask.distributed"]
    loggers = [logging.getLogger(name) for name in names]
    levels = [logging.DEBUG, logging.ERROR, logging.INFO, logging.WARNING]
    for logger, level in zip(loggers, levels, strict=True):
        logger.setLevel(level)
    undo = cluster._quiet()
    assert [logger.level for logger in loggers] == [51, 51, *levels[2:]]
    undo()
    assert [logger.level for logger in loggers] == levels


def test_a_client_that_has_just_closed_is_a_scheduler_that_is_gone():
    engine = a_cluster(_threads={"a": 1}, _serial=0)
    engine._look = lambda: None

    def submit(*args, **options):
        raise RuntimeError("the client has closed")

    engine._client.submit = submit
    with pytest.raises(CampaignError, match=r"^the scheduler at tcp://here is gone \(.*the client has closed\)$"):
        list(engine.outcomes(iter([Job(0, 1)])))
    assert (engine._flights, engine._futures) == ({}, {})


def test_a_worker_is_started_with_its_target_one_thread_of_sums_and_a_folder_of_its_own(monkeypatch, tmp_path):
    """Whatever the environment says of threads and folders; the rest is passed on, and the folder goes at last."""
    asked, ended = [], []

    def started(command, **how):
        asked.append((command, how))
        streams = {name: io.BytesIO() for name in ("stdin", "stdout", "stderr")}
        return SimpleNamespace(kill=lambda: ended.append("kill"), wait=lambda: ended.append("wait"), **streams)

    (tmp_path / "own").mkdir()
    monkeypatch.setattr(local, "scratch_folder", lambda name: tmp_path / "own")
    monkeypatch.setattr(local.subprocess, "Popen", started)
    for name, value in (("OMP_NUM_THREADS", "4"), ("OPENBLAS_NUM_THREADS", "8"), ("TMPDIR", "/other"), ("OURS", "x")):
        monkeypatch.setenv(name, value)
    said = []
    process = local._WorkerProcess(
        "m:f", 330.5, SimpleNamespace(now=lambda: 7.0), SimpleNamespace(put=lambda each: said.append(each[1]))
    )
    ((command, how),) = asked
    module = ["-m", "microrad.campaign.engines.worker", "m:f", "330.5", str(os.getpid())]
    assert command == [sys.executable, "-P", "-X", "faulthandler", *module]
    assert {how[name] for name in ("stdin", "stdout", "stderr")} == {local.subprocess.PIPE}
    threads, folders = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), ("TMPDIR", "TEMP", "TMP")
    own = dict.fromkeys(threads, "1") | dict.fromkeys(folders, str(tmp_path / "own"))
    assert how["env"] == {**os.environ, **own}
    assert (process.job, process.begun, process.ready, process.heard_s) == (None, False, False, 7.0)
    process.kill()
    assert (ended, said) == (["kill", "wait"], [None]), "its end is heard once"
    assert process.process.stdin.closed and not (tmp_path / "own").exists()


def test_jobs_go_to_idle_workers_first_and_then_to_new_ones_up_to_as_many_as_are_allowed(monkeypatch):
    made = []

    class Process:
        def __init__(self, *given):
            self.given, self.job, self.told = given, None, []
            made.append(self)

        def open(self, spec):
            self.told.append(spec)

        def begin(self, job):
            self.job = job
            self.told.append(job)

    monkeypatch.setattr(local, "_WorkerProcess", Process)
    busy, idle = a_worker(Job(0, 8)), a_worker(None)
    begun = []
    idle.begin = lambda job: (begun.append(job), setattr(idle, "job", job))
    engine = an_engine(busy, idle, processes=4)
    engine._target, engine._spec, engine._inbox = "m:f", b"spec", "inbox"
    jobs = iter([Job(1, k) for k in range(5)])
    assert engine._feed(engine_jobs.JobQueue(jobs)) is True
    assert begun == [Job(1, 0)]
    assert [each.told for each in made] == [[b"spec", Job(1, 1)], [b"spec", Job(1, 2)]]
    assert [each.given for each in made] == [("m:f", 10.0, engine._clock, "inbox")] * 2
    assert engine._workers == [busy, idle, *made]
    assert next(jobs) == Job(1, 3), "none is taken that cannot begin"
    made[1].job = None
    assert engine._feed(engine_jobs.JobQueue(iter(()))) is True
    for worker in engine._workers:
        worker.job = None
    assert engine._feed(engine_jobs.JobQueue(iter(()))) is False
    engine._closed = True
    with pytest.raises(CampaignError, match=r"^the workers were stopped while jobs were running$"):
        engine._feed(engine_jobs.JobQueue(iter([Job(1, 4)])))
    assert len(made) == 2


@pytest.mark.parametrize("error", [None, OSError, TimeoutError, ValueError, AttributeError, TypeError, KeyError])
def test_a_late_worker_is_killed_by_its_nanny_or_sent_away_by_the_scheduler(error):
    engine, asked = a_cluster(), []

    def call(what, *args, **options):
        asked.append((what, args, options))
        if error is not None and what == "run":
            raise error("no nanny")
        if error is OSError:
            raise TimeoutError  # the scheduler does not answer either

    engine._call = call
    engine._client._run, engine._client.scheduler.retire_workers = "run", "retire"
    engine._kill("tcp://late")
    by_nanny = ("run", (cluster.kill,), {"workers": ["tcp://late"], "nanny": True})
    sent_away = ("retire", (), {"workers": ["tcp://late"], "close_workers": True, "remove": True})
    assert asked == [by_nanny] + [sent_away] * (error is not None)


def test_what_ended_within_a_slice_is_heard_before_what_is_late():
    """The end of a job that is no longer under way means nothing."""
    engine, ended, waited = a_cluster(_flights={5: Flight(Job(0, 5))}), [9, 5], []

    def get(timeout):
        waited.append(timeout)
        if not ended:
            raise Empty
        return ended.pop(0)

    engine._ended = SimpleNamespace(get=get)
    engine._task_ended = lambda serial, jobs: iter([(serial, jobs)])
    engine._stop_the_late = lambda: iter(["late"])
    assert [list(engine._wait("jobs")) for _ in range(3)] == [["late"], [(5, "jobs"), "late"], ["late"]]
    assert waited == [engine_jobs.SLICE_S] * 3


def test_a_worker_whose_parent_is_gone_ends_at_once(monkeypatch):
    """Only where that takes an error of the system: a message that is no message is a fault of the worker."""
    ended = []
    monkeypatch.setattr(engine_worker.os, "_exit", ended.append)
    said = io.BytesIO()
    engine_worker._tell(said, Message(Kind.DONE, b"abc"))
    assert (said.getvalue(), ended) == (b"\x05\x03\0\0\0\0\0\0\0abc", [])
    for error in (BrokenPipeError(), OSError(28, "full")):
        monkeypatch.setattr(engine_worker, "write_message", raising(error))
        engine_worker._tell(said, Message(Kind.BEAT))
    assert ended == [1, 1]
    monkeypatch.setattr(engine_worker, "write_message", raising(TypeError("odd")))
    with pytest.raises(TypeError):
        engine_worker._tell(said, Message(Kind.BEAT))
    assert ended == [1, 1]


def raising(error):
    def call(*given):
        raise error

    return call


@pytest.mark.parametrize(
    ("system", "parent", "asked", "ended", "dies"),
    [("linux", 7, [(1, signal.SIGKILL)], [], True), ("linux", 8, [(1, signal.SIGKILL)], [1], True),
     ("darwin", 7, [], [], False), ("win32", 8, [], [], False)],
)  # fmt: skip
def test_a_worker_asks_to_be_killed_with_its_parent_where_the_system_can(
    monkeypatch, system, parent, asked, ended, dies
):
    """A parent that had ended before the call is another one by now."""
    calls, exits = [], []
    library = SimpleNamespace(prctl=lambda *given: calls.append(given))
    monkeypatch.setattr(engine_worker.ctypes, "CDLL", lambda name: {None: library}[name])
    monkeypatch.setattr(engine_worker.os, "getppid", lambda: 7)
    monkeypatch.setattr(engine_worker.os, "_exit", exits.append)
    monkeypatch.setattr(engine_worker.sys, "platform", system)
    found = engine_worker.die_with_parent(parent)
    monkeypatch.undo()
    assert (found, calls, exits) == (dies, asked, ended)


def test_a_worker_keeps_its_pipes_for_messages_and_prints_beside_them(monkeypatch):
    """What it reads is nothing from then on, and what it prints goes where errors go."""
    done = []
    calls = {
        "dup": lambda of: 40 + of,
        "fdopen": lambda of, mode: (of, mode),
        "open": lambda name, flags: (done.append(("open", name, flags)), 50)[1],
        "dup2": lambda of, at: done.append(("dup2", of, at)),
        "close": lambda of: done.append(("close", of)),
    }
    system = SimpleNamespace(devnull=os.devnull, O_RDONLY=os.O_RDONLY, **calls)
    printing = SimpleNamespace(stdout="out", stderr="err")
    monkeypatch.setattr(engine_worker, "os", system)
    monkeypatch.setattr(engine_worker, "sys", printing)
    assert engine_worker._take_pipes() == ((40, "rb"), (41, "wb"))
    assert done == [("open", os.devnull, os.O_RDONLY), ("dup2", 50, 0), ("close", 50), ("dup2", 2, 1)]
    assert printing.stdout == "err"


def test_an_engine_refuses_a_worker_of_other_code_than_its_first():
    first, second, third = (SimpleNamespace(ready=False) for _ in range(3))
    engine = an_engine()
    engine._code = ""
    engine._worker_ready(first, "abc")
    engine._worker_ready(second, "abc")
    with pytest.raises(CampaignError) as told:
        engine._worker_ready(third, "abd")
    assert str(told.value) == (
        "the code of microrad changed while the campaign ran: it began with abc, now it is abd; go back to the first, "
        "or begin the campaign anew"
    )
    assert ([each.ready for each in (first, second, third)], engine._code) == ([True, True, False], "abc")


def test_an_engine_stops_those_workers_that_it_is_told_and_passes_over_those_that_another_thread_took():
    killed = []
    workers = [SimpleNamespace(kill=lambda k=k: killed.append(k)) for k in range(4)]
    engine = an_engine(*workers[:3])
    engine._stop(workers[2], workers[3], workers[0])
    assert (killed, engine._workers) == ([2, 3, 0], [workers[1]])


@pytest.mark.parametrize("answer", ["says who it is", "says nothing", "breaks"])
def test_a_scheduler_is_asked_who_it_is_and_let_go_whatever_it_says(monkeypatch, answer):
    done = []

    class Scheduler:
        async def identity(self):
            done.append("asked")
            if answer == "breaks":
                raise OSError("reset")
            if answer == "says nothing":
                await asyncio.Event().wait()

        async def close_rpc(self):
            done.append("closed")

    package = SimpleNamespace(rpc=lambda address: (done.append(address), Scheduler())[1])
    if answer == "says nothing":  # the others have all their time
        monkeypatch.setattr(cluster, "_CONNECT_S", 0.01)
    if answer == "says who it is":
        assert asyncio.run(cluster._asked(package, "tcp://a:1")) is None
    else:
        told = {"says nothing": "it did not answer for 0.01 s", "breaks": "reset"}[answer]
        with pytest.raises(TimeoutError if answer == "says nothing" else OSError, match=f"^{told}$"):
            asyncio.run(cluster._asked(package, "tcp://a:1"))
    assert done == ["tcp://a:1", "asked", "closed"]


def test_a_scheduler_is_told_on_the_loop_of_the_worker_under_the_topic_of_the_campaign(monkeypatch):
    utils, asked = pytest.importorskip("distributed.utils"), []
    monkeypatch.setattr(utils, "sync", lambda *given, **more: asked.append((given, more)))
    worker = SimpleNamespace(loop="loop", scheduler=SimpleNamespace(log_event="log"))
    cluster._tell_now(worker, "topic", [7, "tcp://a"])
    assert asked == [(("loop", "log"), {"topic": "topic", "msg": [7, "tcp://a"]})]


def test_a_client_of_the_cluster_is_no_default_and_hears_the_topic_of_its_campaign(monkeypatch):
    made, engine = [], a_cluster(_topic="topic-7", address="tcp://a:1")

    class Client:
        def __init__(self, *given, **options):
            made.append((given, options))

        def subscribe_topic(self, *given):
            made.append(given)

    async def answers(package, address):
        made.append((package.__class__, address))

    monkeypatch.setattr(cluster, "_asked", answers)
    package = SimpleNamespace(Client=Client)
    assert isinstance(engine._connect(package), Client)
    assert made == [
        (SimpleNamespace, "tcp://a:1"),
        (("tcp://a:1",), {"timeout": cluster._CONNECT_S, "set_as_default": False}),
        ("topic-7", engine._hear),
    ]


def test_a_call_to_the_cluster_has_its_time_to_answer():
    asked, engine = [], object.__new__(DaskEngine)
    engine._client = SimpleNamespace(sync=lambda *given, **more: (asked.append((given, more)), "answer")[1])
    assert engine._call("method", 1, "b", workers=["a"]) == engine._call("other", answer_s=1.5) == "answer"
    assert asked == [
        (("method", 1, "b"), {"callback_timeout": cluster._ANSWER_S, "workers": ["a"]}),
        (("other",), {"callback_timeout": 1.5}),
    ]


def test_a_campaign_has_a_name_on_workers_of_its_function_code_and_specification(monkeypatch):
    """The same for the same campaign; a topic is of one engine alone."""
    monkeypatch.setattr(cluster, "_distributed", lambda: "package")
    monkeypatch.setattr(cluster, "_quiet", lambda: None)
    monkeypatch.setattr(cluster, "Clock", lambda: SimpleNamespace(now=lambda: 42.0))
    monkeypatch.setattr(DaskEngine, "_connect", lambda self, package: (package, self.address))
    made = []
    for spec, target, code in ((b"a", "m:f", "c"), (b"a", "m:f", "c"), (b"b", "m:f", "c"), (b"a", "m:g", "c"),
                               (b"a", "m:f", "d"), (b"c\0a", "m:f", ""), (b"", "m:f\0c", "a")):  # fmt: skip
        monkeypatch.setattr(cluster, "code_sha256", lambda of, code=code: code)
        made.append(DaskEngine(spec, target, "tcp://a:1", 7.0))
    names = [each._name for each in made]
    assert names[0] == names[1] and len(set(names)) == 6
    assert len({each._topic for each in made}) == 7
    first = made[0]
    assert (first._client, first._late_s, first._workers_seen_s) == (("package", "tcp://a:1"), 7.0, 42.0)
    assert (first._spec, first._target, first._code, first._serial) == (b"a", "m:f", "c", 0)
    assert first._looked_s == -math.inf and not first._flights and not first._installed
