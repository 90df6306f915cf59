"""Campaigns: rows of links, efficiency on two cores, the price of 100 000 runs, memory.

    python benchmarks/campaign.py            # everything, some minutes
    python benchmarks/campaign.py --quick    # a tenth of the runs

One axis of the shipped mission under PI, ten seconds a run, a drawn transmit power: 64 runs side by side in the
compiled kernel, the link budgeted under each. One process and two do the same chunks in turn, several times; their
start is left out, and told apart. Efficiency is the time on one over twice the time on two, median of the rounds.

Rows of links alone under a jitter: the crosslink of docs/gallery, by the processor's time. The bar is 100 rows a second
and core.
"""

import resource
import statistics
import subprocess
import sys
import tempfile
import time
from contextlib import closing
from pathlib import Path

from microrad.campaign import bundle, run
from microrad.campaign.file import load_campaign
from microrad.campaign.records import Engine, Job
from microrad.campaign.rows.evaluator import Evaluator
from microrad.campaign.rows.loops import controllers
from microrad.campaign.rows.plan import planned
from recorded import record

HERE = Path(__file__).resolve().parent
MISSION = HERE.parent / "missions" / "leo-geo.toml"
RUNS, ROUNDS = 1024, 5
TEXT = """
mission = "mission.toml"
seed = 1
runs = {runs}
sampling = "random"
worst = 0
{loop}
[inputs."communication.transmit_power"]
distribution = "normal"
mean = "5 W"
deviation = "0.2 W"
"""
LOOP = """
[loop]
controller = "PI"
axes = "one"
duration = "10 s"
"""
MEANS = {
    "one process": run.Means(workers=1),
    "two processes": run.Means(workers=2),
}


def written(folder: str, runs: int, loop: str = LOOP) -> Path:
    """A campaign file."""
    path = Path(folder, "campaign.toml")
    path.with_name("mission.toml").write_text(MISSION.read_text(encoding="utf-8"), encoding="utf-8")
    path.write_text(TEXT.format(runs=runs, loop=loop), encoding="utf-8")
    return path


def timed(engine: Engine, jobs: list[Job]) -> float:
    """Seconds that these chunks take."""
    began = time.perf_counter()
    kinds = [outcome.kind for outcome in engine.outcomes(iter(jobs))]
    assert kinds == ["done"] * len(jobs), kinds
    return time.perf_counter() - began


def efficiency(runs: int) -> None:
    """Each way of doing the work in turn, on the same chunks."""
    with tempfile.TemporaryDirectory() as folder:
        campaign = load_campaign(written(folder, runs))
        spec = bundle.packed(campaign, controllers(campaign, lambda done, total, what: None))
        jobs = planned(campaign).chunks(0, campaign.rows)
        rounds: list[dict[str, float]] = []
        started: dict[str, float] = {}
        for _ in range(ROUNDS):
            rounds.append({})
            for name, means in MEANS.items():  # one at a time: each has the cores to itself
                began = time.perf_counter()
                with closing(means.engine(spec, 600.0)) as engine:
                    timed(engine, jobs[:4])  # every worker has opened the campaign
                    started[name] = time.perf_counter() - began
                    rounds[-1][name] = timed(engine, jobs)
    print(f"{campaign.rows} runs of 10 s, one axis, {len(jobs)} chunks; median of {ROUNDS} rounds")
    for name in MEANS:
        took = statistics.median(each[name] for each in rounds)
        gain = statistics.median(each["one process"] / (2.0 * each[name]) for each in rounds)
        shown = "" if name == "one process" else f", efficiency {gain:.2f}"
        each_ms = 1e3 * took / campaign.rows
        print(f"  {name:18} {took:6.2f} s, {each_ms:.2f} ms a run{shown}; begins in {started[name]:.1f} s")
        if name == "two processes":
            print(f"    100 000 such runs: {took / campaign.rows * 1e5 / 60.0:.0f} min, projected from these")


def memory(runs: int) -> None:
    """Peak memory of the command and of its largest worker for campaigns of growing length."""
    print("\npeak memory of the command and of its largest worker, links alone")
    for rows in (runs, 8 * runs):
        with tempfile.TemporaryDirectory() as folder:
            path = written(folder, rows, loop="")
            code = f"import sys; from pathlib import Path; sys.path.insert(0, {str(HERE)!r}); import campaign as c; "
            code += f"c.peak(Path({str(path)!r}))"
            said = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True).stdout
        print(f"  {rows:8d} rows: {said.strip()}")


def peak(path: Path) -> None:
    """Run a campaign and say how much memory it took."""
    run.run_campaign(path, path.with_suffix(".ledger"), run.Means(threads=2))
    own, child = (resource.getrusage(who).ru_maxrss / 1024 for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    print(f"{own:.0f} MB and {child:.0f} MB")


# what a row draws beside the rms of the jitter about x, with the bounds
BESIDE = {
    "": "",
    "communication.transmit_power": 'low = "0.1 W"\nhigh = "0.3 W"',
    "terminals.leo_aperture": 'low = "4 cm"\nhigh = "5 cm"',
}
COUNTER = """
[communication.receiver]
modulation = "ook"
detector = "photon-counting"
bit_error_ratio = 1e-9
code_gain = "0 dB"
code_rate = 1.0
bandwidth = "10 GHz"
extinction_ratio = "20 dB"
efficiency = 0.5
dark_count_rate = "1000 1/s"
background_power = "1 pW"
"""


def crosslinks() -> dict[str, str]:
    """The crosslink by its convention for the pointing loss, and with a receiver whose power has to be searched for."""
    pattern = (HERE.parent / "docs" / "gallery" / "crosslink.toml").read_text(encoding="utf-8")
    begin, end = pattern.index("[communication.beam]"), pattern.index("[requirement]")
    gaussian = (pattern[:begin] + pattern[end:]).replace('pointing_loss = "pattern"', 'pointing_loss = "gaussian"')
    lines = [line for line in gaussian.split("\n") if not line.startswith("receiver_sensitivity")]
    counter = "\n".join(lines).replace("[requirement]", COUNTER + "[requirement]")
    return {"gaussian": gaussian, "pattern": pattern, "gaussian, photon counter": counter}


def links(rows: int) -> None:
    """Rows a second and core of links alone under a jitter, all outputs but those of the day kept."""
    print("\nlinks alone under a jitter, rows a second and core")
    for name, text in crosslinks().items():
        for key, bounds in BESIDE.items():
            with tempfile.TemporaryDirectory() as folder:
                Path(folder, "mission.toml").write_text(text, encoding="utf-8")
                drawn = {"jitter.rms.1": 'low = "5 urad"\nhigh = "7 urad"', key: bounds}
                tables = (f'[inputs."{k}"]\ndistribution = "uniform"\n{b}\n' for k, b in drawn.items() if k)
                path = Path(folder, "campaign.toml")
                head = f'mission = "mission.toml"\nseed = {len(name + key)}\nruns = {rows + 8}\nsampling = "random"\n'
                path.write_text(head + "".join(tables), encoding="utf-8")
                campaign = load_campaign(path)
            evaluator = Evaluator(campaign, {})
            evaluator.rows(0, range(rows, rows + 8), lambda: None)  # whatever is slow to load
            began = time.process_time()
            chunk = evaluator.rows(0, range(rows), lambda: None)
            took = time.process_time() - began
            assert not chunk.failed, chunk.failed
            record(f"links alone, {name}: rms{' and ' * bool(key) + key}", rows / took, "rows/s", at_least=100)
            print(f"  {name:24} rms{' and ' * bool(key) + key:36} {rows / took:6.0f}")


if __name__ == "__main__":
    quick = "--quick" in sys.argv
    links(200 if quick else 2000)
    efficiency(RUNS // 8 if quick else RUNS)
    memory(5_000 if quick else 50_000)
