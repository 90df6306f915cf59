"""Fixtures that run commands in this process, for the tests of the command line."""

import contextlib
import gc
import importlib
import os
import random
from functools import cache

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # as the command line does, before numpy is loaded
os.environ.pop("MAKEFLAGS", None)  # a make that tests call is not part of the one that calls them

import pytest
import typer.main
from hypothesis import settings

import reference.within  # before the package, which it loads its own way
import shared
import waiting
from command_line import Result, listing
from microrad import cli
from small_campaign import without_worker

pytest_plugins = ("browser",)

typer.main.get_command = cache(typer.main.get_command)  # once in a process, not for each of thousands of commands

# The gate looks at the same examples each time: what one run finds, the next one finds, too. To look for new ones:
# HYPOTHESIS_PROFILE=explore make unit
settings.register_profile("gate", derandomize=True)
settings.register_profile("explore")
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "gate"))
if os.environ.get("HYPOTHESIS_PROFILE", "gate") == "gate":
    # Else the numbers of whatever modules a worker has imported so far would be among the examples.
    with contextlib.suppress(ImportError, AttributeError):  # it has no public switch, and other versions may differ
        providers = importlib.import_module("hypothesis.internal.conjecture.providers")
        nothing = importlib.import_module("hypothesis.internal.constants_ast").Constants
        assert callable(providers._get_local_constants)
        providers._get_local_constants = nothing


LONGEST = (
    "test_studio_browser.py",
    "test_campaign_run.py",
    "test_selection.py",
    "test_campaign_cluster.py",
    "test_cli.py",
    "test_docs_gallery.py",
    "test_report_browser.py",
    "test_study.py",
    "test_export_flight.py",
    "test_studio_jobs.py",
    "test_studio_pages_closed.py",
    "test_campaign_optimise.py",
    "test_report.py",
    "test_studio_bench_browser.py",
    "test_tuning.py",
    "test_studio_design_browser.py",
    "test_export_fmu.py",
    "test_docs_campaigns.py",
    "test_identify.py",
    "test_kernels.py",
    "test_stiffness.py",
    "test_campaign_export.py",
    "test_docs_report.py",
    "test_campaign_engines.py",
    "test_export_fixed.py",
    "test_kept_run.py",
    "test_linear_model.py",
    "test_cli_day.py",
    "test_reproduce.py",
    "test_kept_study.py",
    "test_controller_study.py",
    "test_pointing_loop.py",
    "test_day_study.py",
    "test_export_operations.py",
    "test_studio_commands.py",
    "test_link_study.py",
    "test_studio_server.py",
    "test_campaign_ledger.py",
    "test_mission.py",
)
"""Files that processes are handed first: none of them is left with a long one when the others have ended."""


def pytest_collection_modifyitems(config, items):
    """The longest files first where processes share them; repetitions only where they are asked for."""
    if not os.environ.get("MICRORAD_ENDURANCE"):
        repeated = [item for item in items if item.get_closest_marker("endurance")]
        items[:] = [item for item in items if not item.get_closest_marker("endurance")]
        config.hook.pytest_deselected(items=repeated)
    if order := os.environ.get("MICRORAD_ORDER"):  # of scripts/within: what hangs on the order of tests is not held
        random.Random(order).shuffle(items)
        files = list(dict.fromkeys(item.path for item in items))
        items.sort(key=lambda item: files.index(item.path))
    elif hasattr(config, "workerinput"):
        items.sort(key=lambda item: LONGEST.index(item.path.name) if item.path.name in LONGEST else len(LONGEST))


def pytest_configure(config):
    shared.begin(config)
    if reference.within.MODE:
        config.pluginmanager.register(reference.within.Within())
    waiting.told = os.dup(2)  # before what tests write is taken in
    if not hasattr(config, "workerinput") and config.getoption("numprocesses", None):
        waiting.end_all_later()  # this process has no tests of its own
    gc.disable()  # while modules and tests are read: none of that is garbage


def pytest_collection_finish():
    """From here on there may be garbage, which clusters need to have found: it ends what closed workers still hold.

    What is there by now stays: nobody looks through it again. For what comes, looking seldom is enough.
    """
    gc.freeze()
    gc.set_threshold(20_000, 20, 20)
    gc.enable()


@pytest.fixture(scope="session", autouse=True)
def own_state(tmp_path_factory):
    """What microrad keeps for its user outside of working folders goes to a folder of the tests."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_STATE_HOME", str(tmp_path_factory.mktemp("state")))
        patch.setenv("MICRORAD_KEEP", "no")  # every number that a test sees is computed in it
        yield


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """An empty current folder."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def undrawn(monkeypatch):
    """Reports without figures; `test_init_then_run` and `test_identify_prints_both_models…` draw them."""
    from microrad.report.day import figures as day
    from microrad.report.identification import page as identification
    from microrad.report.links import figures as links
    from microrad.report.paper import bench, figures

    for module, name in (
        (day, "day_figures"),
        (figures, "paper_figures"),
        (links, "link_figures"),
        (bench, "bench_figures"),
    ):
        monkeypatch.setattr(module, name, lambda *args: ())
    monkeypatch.setattr(identification, "identification_figures", lambda *args, **more: {})


@pytest.fixture
def rows_here(monkeypatch):
    """Campaigns without a worker process, for tests of what is made of their rows."""
    without_worker(monkeypatch)


@pytest.fixture
def call(capsys):
    """Run a command in this process."""

    def run(*args):
        with pytest.raises(SystemExit) as stop:
            cli.app(args=[str(a) for a in args], prog_name="microrad")
        out, err = capsys.readouterr()
        return Result(int(stop.value.code or 0), out, err)

    return run


@pytest.fixture
def refused(call, folder):
    """Run a command that must be refused: exit 2, nothing on stdout, no traceback, nothing written; its message."""

    def run(*args):
        before = listing(folder)
        result = call(*args)
        assert (result.code, result.out) == (2, ""), result
        assert "Traceback" not in result.err
        assert listing(folder) == before
        return result.err

    return run
