"""The dask engine: workers of a scheduler die, hang, differ and go away."""

import json
import os
import random
import signal
import subprocess
import sys
import threading
from concurrent.futures import CancelledError
from contextlib import suppress
from types import SimpleNamespace

import psutil
import pytest

from microrad.campaign.engines import cluster
from microrad.campaign.engines.cluster import DaskEngine, Flight, late_flights
from microrad.campaign.engines.jobs import JobQueue
from microrad.campaign.records import CampaignError, Job
from small_campaign import import_path, killing
from small_campaign import kill as kill_process
from waiting import HANG_S, beside, no_hang, until

KilledWorker = pytest.importorskip("distributed.scheduler").KilledWorker

LATE_S = 5.0  # a job that does nothing but end may be silent for half of that on a busy machine
TARGET = "campaign_target:open_work"
TABLE = {
    "100": "killed",
    "101": "hang",
    "102": "shout",
    "103": "refuse",
    "104": "leave",
    "105": "slow 550",  # times 10 ms at least
    "106": "hog",
}


def workers_here(pid=None):
    """Worker processes behind the nannies that a process (this one) has started; each may end meanwhile."""
    found = []
    for process in psutil.Process(pid).children(recursive=True):
        with suppress(psutil.Error):
            if "spawn_main" in " ".join(process.cmdline()):
                found.append(process)
    return found


def workers_there(engine):
    """Identities of the workers of an engine's scheduler, each start a new one.

    The scheduler is asked, as what the client keeps of its answers is without workers for moments.
    """
    client = engine._client
    return {each["id"] for each in client.sync(client.scheduler.identity, n_workers=-1)["workers"].values()}


def chunks(*numbers):
    return [Job(0, n) for n in numbers]


def run(engine, jobs):
    """Outcomes by number of the job; each job has one."""
    outcomes = list(engine.outcomes(iter(jobs)))
    assert sorted(o.job for o in outcomes) == sorted(jobs)
    return {o.job.number: o for o in outcomes}


def kinds(outcomes):
    return {number: o.kind for number, o in outcomes.items() if o.kind != "done"}


@pytest.fixture(autouse=True, scope="module")
def target_for_children():
    before = os.environ.get("PYTHONPATH")
    os.environ["PYTHONPATH"] = import_path()
    yield
    if before is None:
        del os.environ["PYTHONPATH"]
    else:
        os.environ["PYTHONPATH"] = before


@pytest.fixture(scope="module")
def stuck(tmp_path_factory):
    """The mark of a job that has begun and would not end."""
    return tmp_path_factory.mktemp("mark") / "stuck"


def whole(told):
    """Whether a scheduler has said all about itself."""
    return told.exists() and told.read_text("utf-8").endswith("}")


class Elsewhere:
    """A scheduler and workers started as one does by hand."""

    def __init__(self, folder, **environment):
        self.folder, self.started, self.count = folder, [], 0
        told = folder / "scheduler.json"  # written once it listens, at a port that nobody else can have taken
        own = ("--host", "127.0.0.1", "--port", "0", "--no-dashboard", "--scheduler-file", str(told))
        self.scheduler = self.start("scheduler", *own, **environment)
        until(lambda: self.scheduler.poll() is not None or whole(told), "a scheduler")
        assert self.scheduler.poll() is None, self.log
        self.address = json.loads(told.read_text("utf-8"))["address"]

    def start(self, what, *arguments, prelude="", **environment):
        code = f"{prelude}\nimport runpy; runpy.run_module('distributed.cli.dask_{what}', run_name='__main__')"
        with (self.folder / "log").open("a") as log:
            process = subprocess.Popen(
                [sys.executable, "-c", code, *arguments],
                cwd=self.folder, env=os.environ | environment, stdout=log, stderr=log,
            )  # fmt: skip
        self.started.append(process)
        return process

    @property
    def log(self):
        return (self.folder / "log").read_text("utf-8", "replace")

    def worker(self, *arguments, **kwargs):
        own = ("--nthreads", "1", "--no-dashboard", "--local-directory", str(self.folder), *arguments)
        return self.start("worker", self.address, *own, **kwargs)

    def close(self):
        for process in reversed(self.started):
            for child in psutil.Process(process.pid).children(recursive=True):
                kill_process(child.pid)
            process.kill()
            process.wait()


@pytest.fixture(scope="module")
def there(tmp_path_factory):
    """A scheduler with two workers, where a death of a worker is its job's."""
    one = Elsewhere(tmp_path_factory.mktemp("there"), DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES="0")
    one.worker("--nworkers", "2")
    yield one
    one.close()


@pytest.fixture(scope="module")
def engine(there, stuck):
    """An engine on these workers, whose jobs do what the table by number says."""
    table = TABLE | {"107": f"endless_once {stuck}", "else": "slow"}
    one = DaskEngine(json.dumps(table).encode(), TARGET, there.address, late_s=LATE_S)
    until(lambda: len(workers_there(one)) == 2, "two workers")
    yield one
    one.close()


@pytest.mark.promise("campaigns-61")
def test_every_job_has_its_own_result_and_both_workers_work(engine):
    outcomes = engine.outcomes(iter(chunks(*range(20))))
    first, places = next(outcomes), set()
    done = {first.job.number: first.payload}
    for outcome in outcomes:
        places |= {flight.where for flight in engine._flights.values() if flight.begun}
        done[outcome.job.number] = outcome.payload
    assert done == {n: f"0/{n}/-1".encode() for n in range(20)}
    assert len(places) == 2


@pytest.mark.promise("campaigns-53")
def test_jobs_are_taken_only_as_fast_as_they_start(engine):
    taken = []
    outcomes = engine.outcomes(taken.append(j) or j for j in chunks(*range(99)))
    for done in range(1, 6):
        next(outcomes)
        assert len(taken) <= done + 4, "two for each worker"
    outcomes.close()
    assert len(taken) < 15


def test_errors_are_of_their_job_alone_and_keep_their_words(engine):
    outcomes = run(engine, chunks(0, 102, 1, 103, 2, 104))
    assert kinds(outcomes) == {102: "raised", 103: "raised", 104: "raised"}
    assert outcomes[102].reason == "ValueError: no mirror at all"
    assert outcomes[103].reason == "row 3: no mission"
    assert outcomes[104].reason == "SystemExit: enough"


@pytest.mark.promise("campaigns-54")
@pytest.mark.promise("campaigns-62")
def test_a_job_that_kills_its_worker_has_died_and_those_that_waited_there_come_out(engine):
    outcomes = run(engine, chunks(0, 100, *range(1, 10)))
    assert kinds(outcomes) == {100: "died"}
    assert outcomes[100].reason.startswith("its worker at tcp://127.0.0.1:")
    assert outcomes[100].reason.endswith(" ended")


@pytest.mark.promise("campaigns-55")
@pytest.mark.parametrize(
    "silent", [pytest.param(101, marks=pytest.mark.endurance), 106], ids=["hangs", "keeps the lock"]
)
def test_a_job_without_a_sign_of_life_is_late_and_one_that_lasts_is_not(engine, silent):
    until(lambda: len(workers_there(engine)) == 2, "two workers")
    before = workers_there(engine)
    outcomes = run(engine, chunks(silent, 105, *range(6)))
    assert kinds(outcomes) == {silent: "late"}
    assert outcomes[silent].reason == "gave no sign of life for 5 s and was stopped"
    until(lambda: len(workers_there(engine)) == 2, "the worker that its nanny has started again")
    assert len(workers_there(engine) & before) == 1


@pytest.mark.parametrize("looked", [False, True])
def test_a_job_whose_worker_ended_has_died_and_is_not_late_however_slowly_that_is_told(engine, looked):
    """On a busy machine the scheduler's word may come later than the job is late."""
    ended = "tcp://127.0.0.1:9"
    flight = Flight(Job(0, 7), heard_s=engine._clock.now() - 2.0 * LATE_S, where=ended)
    engine._flights[0], engine._futures[0] = flight, SimpleNamespace(status="error")
    assert late_flights(engine._flights, engine._clock.now(), LATE_S) == [0]
    if looked:
        engine._looked_s = float("-inf")
        engine._look()
    assert list(engine._stop_the_late()) == []
    last = SimpleNamespace(address=ended)
    (outcome,) = engine._failed(0, KilledWorker("job", last, 0), JobQueue(iter(())))
    assert (outcome.kind, outcome.reason) == ("died", f"its worker at {ended} ended")
    engine._kill(ended)  # as where it ends between the look and this


@pytest.mark.promise("campaigns-53")
@pytest.mark.promise("campaigns-61")
def test_workers_killed_at_random_lose_and_double_nothing(engine, stuck):
    """Job 107 is endless until it is killed; so a kill hits a job, however the others fall between them."""
    jobs = 60 if os.environ.get("MICRORAD_ENDURANCE") else 15
    todo, done, died, generator = chunks(107, *range(jobs)), {}, set(), random.Random(1)
    names = sorted(job.number for job in todo)

    def begun():
        return any(flight.begun and flight.job.number == 107 for flight in list(engine._flights.values()))

    def kill_all():
        until(lambda: stuck.exists() and begun(), "the job that does not end")
        for worker in workers_here():
            kill_process(worker.pid)  # one of them may just have been

    def kill():
        living = workers_here()
        if len(engine._threads) == 2 and living:  # a cluster whose workers die as they start never works
            kill_process(generator.choice(living).pid)

    with killing(kill, 0.1) as heard:
        killer = beside(kill_all)
        while todo:
            outcomes = list(map(heard, engine.outcomes(iter(todo))))
            assert sorted(o.job for o in outcomes) == sorted(todo)
            done |= {o.job.number: o.payload for o in outcomes if o.kind == "done"}
            todo = [o.job for o in outcomes if o.kind != "done"]
            died |= {job.number for job in todo}
    killer.join(HANG_S)
    assert done == {n: f"0/{n}/-1".encode() for n in names}
    assert 107 in died


# --------------------------------------------------------------------------------------------- a scheduler elsewhere
@pytest.fixture
def elsewhere(tmp_path):
    one = Elsewhere(tmp_path)
    yield one
    one.close()
    print(one.log)  # shown where a test fails


def connect(elsewhere, table="{}", late_s=20.0):
    """An engine; its workers may still be starting."""
    return DaskEngine(table.encode(), TARGET, elsewhere.address, late_s=late_s)


@pytest.mark.promise("campaigns-46", "campaigns-56")
def test_a_scheduler_that_goes_away_is_told(elsewhere):
    elsewhere.worker("--no-nanny")
    one = connect(elsewhere, '{"0": "work", "1": "work", "2": "work", "else": "endless"}')
    outcomes = one.outcomes(iter(chunks(*range(1000))))
    assert [next(outcomes).kind for _ in range(3)] == ["done"] * 3
    elsewhere.scheduler.kill()
    with no_hang(), pytest.raises(CampaignError, match=f"the scheduler at {elsewhere.address} is gone"):
        list(outcomes)
    one.close()


@pytest.mark.promise("campaigns-56")
@pytest.mark.skipif(not hasattr(signal, "SIGSTOP"), reason="no process can be stopped")
def test_a_scheduler_that_is_there_and_silent_is_told(elsewhere, monkeypatch):
    elsewhere.worker("--no-nanny")
    one = connect(elsewhere, '{"0": "work", "else": "endless"}')
    outcomes = one.outcomes(iter(chunks(*range(1000))))
    assert next(outcomes).kind == "done"
    elsewhere.scheduler.send_signal(signal.SIGSTOP)
    monkeypatch.setattr(cluster, "_ANSWER_S", 0.5)
    monkeypatch.setitem(DaskEngine._call.__kwdefaults__, "answer_s", 0.5)
    words = rf"the scheduler at {elsewhere.address} is gone \(it did not answer for 0\.5 s\)"
    with no_hang(), pytest.raises(CampaignError, match=words):
        list(outcomes)
    one.close()


@pytest.mark.promise("campaigns-54", "campaigns-62")
@pytest.mark.parametrize(
    ("allowed", "words"), [(0, ""), (1, ", the last of 2 that it was tried on"), (3, ", the last of 4")]
)
def test_a_chunk_has_died_with_one_worker_more_than_the_scheduler_allows_to_fail(allowed, words):
    """The scheduler gives it up by itself; a lower number loses fewer workers on it."""
    last = "tcp://127.0.0.1:9"
    flight = Flight(Job(0, 7), where=last)
    engine = SimpleNamespace(_flights={0: flight}, _forgiven=set(), _drop=lambda serial: flight)
    error = KilledWorker("job", SimpleNamespace(address=last), allowed)
    (outcome,) = DaskEngine._failed(engine, 0, error, JobQueue(iter(())))
    assert outcome.kind == "died"
    assert outcome.reason.startswith(f"its worker at {last} ended{words}") and ("the last" in outcome.reason) == bool(
        words
    )


def test_workers_elsewhere_serve_one_engine_after_another_and_forget(there):
    one = connect(there)
    assert kinds(run(one, chunks(0, 1, 2, 3))) == {}
    one.close()
    # None is late here: on a busy machine the first job could be, and would come again behind the endless one.
    one = connect(there, '{"4": "endless", "5": "endless"}', late_s=HANG_S)
    next(one.outcomes(iter(chunks(0, 4, 5))))
    one.close()
    with no_hang():  # behind a job that was not forgotten it would wait without end
        one = connect(there)
        assert kinds(run(one, chunks(0, 4, 5))) == {}
        one.close()


@pytest.mark.promise("campaigns-52")
def test_a_worker_with_other_code_is_refused_with_both_hashes(there, monkeypatch):
    monkeypatch.setenv("CODE_OF_TARGET", "d1ff")  # in this process
    one = connect(there)
    with pytest.raises(CampaignError, match=r"the worker at tcp://.*: runs other code .*: c0de, .* campaign's is d1ff"):
        run(one, chunks(0))
    one.close()


@pytest.fixture(scope="module")
def lonely(tmp_path_factory):
    """A scheduler without workers; the last test that uses it starts one that is no good."""
    one = Elsewhere(tmp_path_factory.mktemp("lonely"))
    yield one
    one.close()
    print(one.log)


@pytest.mark.promise("campaigns-53")
def test_a_scheduler_without_workers_is_told(lonely, monkeypatch):
    monkeypatch.setattr(cluster, "_NO_WORKERS_S", 1.0)
    one = connect(lonely)
    with pytest.raises(CampaignError, match="had no worker for 1 s: start some with `dask worker tcp://"):
        run(one, chunks(0))
    one.close()


def test_a_worker_without_microrad_is_refused(lonely):
    """Also where it joins a campaign that waits for workers: a job would end it before it was looked at."""
    one = connect(lonely)
    bare = {"prelude": "import sys; sys.modules['microrad'] = None"}
    joins = beside(lambda: (until(lambda: one._looked_s > 0.0, "a look"), lonely.worker("--no-nanny", **bare)))
    with pytest.raises(CampaignError, match=r"the worker at tcp://\S* has no microrad that fits .* code is c0de"):
        run(one, chunks(0))
    joins.join(HANG_S)
    one.close()


def test_work_that_cannot_be_opened_is_an_error_with_its_words(there):
    one = connect(there, "refuse")
    with pytest.raises(CampaignError, match=r"the worker at tcp://\S*: mission.toml: no such mission"):
        run(one, chunks(0))
    one.close()


@pytest.mark.parametrize(
    "address", ["tcp://127.0.0.1:9", "no-such-kind://x", "tcp://127.0.0.1", "tls://127.0.0.1:9", "ucx://127.0.0.1:9"]
)
def test_an_address_without_a_scheduler_is_told(monkeypatch, address):
    monkeypatch.setattr(cluster, "_CONNECT_S", 1.0)
    threads = threading.active_count()
    with pytest.raises(CampaignError, match=f"no scheduler answers at {address} "):
        DaskEngine(b"{}", TARGET, address)
    assert threading.active_count() <= threads + 2, "none but of distributed's own pools"


def test_without_distributed_the_extra_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(CampaignError, match=r"constraints.txt '\.\[cluster\]'"):
        DaskEngine(b"{}", TARGET, "tcp://127.0.0.1:9")


@pytest.mark.promise("campaigns-55")
def test_a_worker_without_a_nanny_is_sent_away():
    """Where there is no nanny that could kill it, the scheduler retires it and takes no more from it."""
    asked = []

    def call(what, *args, **options):
        asked.append((what, options))
        if what == "run":
            raise ValueError("no nanny")

    scheduler = SimpleNamespace(retire_workers="retire")
    engine = SimpleNamespace(_call=call, _client=SimpleNamespace(_run="run", scheduler=scheduler))
    DaskEngine._kill(engine, "tcp://127.0.0.1:9")
    address = {"workers": ["tcp://127.0.0.1:9"]}
    assert asked == [
        ("run", address | {"nanny": True}),
        ("retire", address | {"close_workers": True, "remove": True}),
    ]


@pytest.mark.parametrize("error", [CancelledError, OSError, TimeoutError])
def test_a_result_that_cannot_be_fetched_is_computed_again(error):
    """Its worker died, or its connection broke, behind the end of the job."""
    again = []

    def result(timeout):
        raise error

    engine = SimpleNamespace(
        _futures={3: SimpleNamespace(result=result)},
        _wait_for_scheduler=lambda: again.append("waited"),
        _again=lambda serial, queue: again.append((serial, queue)),
    )
    assert list(DaskEngine._finished(engine, 3, "queue")) == []
    assert again == ["waited", (3, "queue")]


# ------------------------------------------------------------------------------------------ stand-ins for the cluster
class Deed:
    """Work that lives twice and then gives its job's name, or fails."""

    def __init__(self, error=None, between=lambda: None):
        self.error, self.between = error, between

    def do(self, job, beat):
        beat()
        self.between()
        beat()
        if self.error:
            raise self.error
        return f"{job.cell}/{job.number}/{job.row}/{job.kind}".encode()


@pytest.fixture
def on_worker(monkeypatch):
    """What a worker answers to a job, and what it has told its scheduler, for a work of this name."""
    told = []
    there = SimpleNamespace(address="tcp://w:1", log_event=lambda topic, said: told.append((topic, said)))
    monkeypatch.setattr("distributed.get_worker", lambda: there)
    monkeypatch.setattr(cluster, "_tell_now", lambda worker, topic, said: told.append((worker.address, topic, said)))
    monkeypatch.setattr(cluster, "code_sha256", lambda target: "c0de")
    monkeypatch.setattr(cluster, "_openings", {})

    def answered(made, name="work", every_s=0.0):
        monkeypatch.setattr(cluster, "open_target", lambda target, spec: made())
        cluster.install("work", "m:f", b"", "c0de")
        found = cluster.do(name, "topic", 5, (3, 1, 2, "row"), every_s)
        return cluster.Kind(found[0]).name, found[1:].decode(), told

    return answered


BEGUN, LIVES = ("tcp://w:1", "topic", [5, "tcp://w:1"]), ("topic", [5, "tcp://w:1"])


def refused():
    raise CampaignError("no µ\n mission")


def forgotten():
    cluster.forget("work")


@pytest.mark.parametrize(
    ("made", "name", "every_s", "answer", "told"),
    [
        (Deed, "work", 0.0, ("DONE", "3/1/2/row"), [BEGUN, LIVES, LIVES]),
        (Deed, "work", 3600.0, ("DONE", "3/1/2/row"), [BEGUN, LIVES]),
        (lambda: Deed(ValueError("no µ")), "work", 0.0, ("RAISED", "ValueError: no µ"), [BEGUN, LIVES, LIVES]),
        (lambda: Deed(SystemExit(3)), "work", 3600.0, ("RAISED", "SystemExit: 3"), [BEGUN, LIVES]),
        (
            lambda: Deed(between=lambda: cluster.forget("work")),
            "work",
            0.0,
            ("RAISED", "_StoppedError"),
            [BEGUN, LIVES],
        ),
        (refused, "work", 0.0, ("REFUSED", "the worker at tcp://w:1: no µ mission"), []),
        (Deed, "other", 0.0, ("OPEN", "tcp://w:1"), []),
    ],
)
def test_a_worker_answers_for_its_job_and_tells_when_it_begins_and_lives(on_worker, made, name, every_s, answer, told):
    assert on_worker(made, name, every_s) == (*answer, told)


def flying(where="tcp://a", forgiven=()):
    """An engine with two jobs under way, the second at some worker."""
    engine = object.__new__(DaskEngine)
    engine._flights = {1: Flight(Job(3, 5), 99.0, "tcp://b"), 2: Flight(Job(4, 6), 98.0, where)}
    engine._futures = {k: SimpleNamespace(status="error") for k in engine._flights}
    engine._forgiven = set(forgiven)
    return engine


@pytest.mark.parametrize(
    ("where", "forgiven", "allowed", "reason"),
    [
        ("tcp://a", (1,), 0, "its worker at tcp://a ended"),
        ("tcp://a", (1,), 2, "its worker at tcp://a ended, the last of 3 that it was tried on"),
        ("tcp://a", (2,), 0, None),  # killed for its neighbour
        ("tcp://b", (), 0, None),  # begun elsewhere
        ("", (), 0, None),  # not begun at all
    ],
)
def test_a_job_dies_with_the_worker_that_it_had_begun_on_alone(where, forgiven, allowed, reason):
    engine, queue = flying(where, forgiven), JobQueue(iter(()))
    error = KilledWorker("job", SimpleNamespace(address="tcp://a"), allowed)
    found = [(each.job, each.kind, each.reason) for each in engine._failed(2, error, queue)]
    assert found == ([(Job(4, 6), "died", reason)] if reason else [])
    assert queue.next() == (None if reason else Job(4, 6))
    assert (list(engine._flights), engine._forgiven) == ([1], set(forgiven) - {2})


def test_an_error_that_is_no_death_is_the_jobs_and_a_worker_without_microrad_the_campaigns():
    engine = flying()
    (raised,) = engine._failed(2, KeyError("a\nb"), JobQueue(iter(())))
    assert (raised.job, raised.kind, raised.reason, raised.payload) == (Job(4, 6), "raised", "KeyError: 'a\\nb'", b"")
    with pytest.raises(CampaignError) as told:
        list(engine._failed(1, ModuleNotFoundError("No module named 'microrad'"), JobQueue(iter(()))))
    assert str(told.value) == (
        "a worker has no microrad that fits (ModuleNotFoundError: No module named 'microrad'): install it there"
    )


@pytest.mark.parametrize(
    ("error", "words"),
    [
        (OSError("Timed out trying\n to connect"), "OSError: Timed out trying to connect"),
        (ValueError("unknown address scheme"), "ValueError: unknown address scheme"),
        (TimeoutError(), "TimeoutError: it did not answer for 0.25 s"),
        (AssertionError("no loop"), "AssertionError: no loop"),
    ],
)
def test_a_scheduler_that_cannot_be_reached_is_told_by_its_address_and_all_is_undone(monkeypatch, error, words):
    closed = []

    async def identity():
        raise error

    async def close_rpc():
        closed.append("rpc")

    rpc = SimpleNamespace(identity=identity, close_rpc=close_rpc)
    engine = object.__new__(DaskEngine)
    engine.address, engine._clock = "tcp://s:9", SimpleNamespace(close=lambda: closed.append("clock"))
    engine._undo_quiet = lambda: closed.append("quiet")
    monkeypatch.setattr(cluster, "_CONNECT_S", 0.25)
    with pytest.raises(CampaignError) as told:
        engine._connect(SimpleNamespace(rpc=lambda address: rpc))
    assert str(told.value) == (
        f"no scheduler answers at tcp://s:9 ({words}): start one with `dask scheduler`, and say the address that it "
        "prints"
    )
    assert closed == ["rpc", "clock", "quiet"]
