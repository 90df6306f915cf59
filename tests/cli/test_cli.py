"""The command line: exit codes, what is printed and where, each refusal's message, and that it writes nothing."""

import ctypes
import errno
import importlib
import json
import math
import os
import pkgutil
import re
import shlex
import signal
import subprocess
import sys
import time
from contextlib import nullcontext
from dataclasses import asdict, replace
from pathlib import Path
from types import SimpleNamespace

import h5py
import numpy as np
import pytest
import typer
from nptdms import ChannelObject, TdmsWriter

import microrad
from command_line import listing
from microrad import cli, report
from microrad.cli import frame, installation, lab, recordings
from microrad.lab import identify
from microrad.loop import control, controller_study
from microrad.loop.controller_study import designs
from microrad.mission.file import load_mission
from microrad.report.identification import page as identification
from microrad.study import study
from places import ROOT
from shipped import without_day, without_fine_pointing
from waiting import HANG_S, lines_of, until

PAPER = ROOT / "src" / "microrad" / "mission" / "missions" / "leo-geo.toml"
COMMANDS = (
    "init",
    "run",
    "reproduce",
    "budget",
    "contacts",
    "constellation",
    "presets",
    "design",
    "pointing",
    "jitter",
    "worst-case",
    "identify",
    "import",
    "bench",
    "doctor",
    "verify",
    "studio",
    "schema",
    "explain",
)
MICRORAD = (sys.executable, "-m", "microrad")
COLUMNS = ("--input", "drive", "--output", "angle", "--rate", "1000", "--static")


def write_recording(path, reverse=False):
    """One second and a half of a loop with hysteresis, 1500 samples at 1 kHz, a header and three columns."""
    time_s = np.arange(1500) / 1000.0
    drive = 6.0 - 6.0 * np.cos(2 * np.pi * 4.0 * time_s)
    play, angle = 0.0, []
    for u in drive:
        play = max(u - 1.0, min(u + 1.0, play))
        angle.append(0.06 * u + 0.03 * play)
    sign = -1.0 if reverse else 1.0
    noise = 1e-3 * np.random.default_rng(1).standard_normal(time_s.size)
    table = np.column_stack((time_s, drive, sign * (np.array(angle) + noise)))
    np.savetxt(path, table, delimiter=",", header="time,drive,angle", comments="", fmt="%.9g")
    return path


@pytest.fixture(scope="module")
def loop_mirror(tmp_path_factory):
    """A recording, and the mirror file that `identify` made of it."""
    home = tmp_path_factory.mktemp("identified")
    recording, mirror = write_recording(home / "loop.csv"), home / "loop-mirror.toml"
    with pytest.raises(SystemExit) as stop, pytest.MonkeyPatch.context() as patch:
        patch.setattr(identification, "identification_figures", lambda *args, **more: {})
        cli.app(args=["identify", str(recording), *COLUMNS, "--mirror-file", str(mirror)], prog_name="microrad")
    assert not stop.value.code
    return mirror


@pytest.fixture(scope="module")
def plain(tmp_path_factory):
    """The paper's mission without its fine-pointing loop and its day, which take most of a study's time."""
    return mission(tmp_path_factory.mktemp("plain") / "leo-geo.toml")


@pytest.fixture(scope="module")
def plain_found(plain):
    """The study of that mission."""
    return study.run_study(load_mission(plain))


def mission(path, *changes):
    """The paper's mission with texts replaced, without its fine-pointing loop and its day."""
    text = without_day(without_fine_pointing(PAPER.read_text(encoding="utf-8")))
    for old, new in changes:
        assert text.count(old) == 1, old
        text = text.replace(old, new)
    path.write_text(text, encoding="utf-8")
    return path


# --------------------------------------------------------------------------------------------------------------- help
@pytest.mark.parametrize("command", COMMANDS)
def test_help_of_each_command_shows_a_worked_example(call, command):
    result = call(command, "--help")
    assert result.code == 0
    assert "Examples:" in result.out
    assert f"  microrad {command}" in result.out.partition("Examples:")[2]
    assert "--help" in result.out


@pytest.mark.parametrize("command", COMMANDS)
def test_the_examples_are_good_usage(command):
    group = typer.main.get_command(cli.app)
    lines = [line.partition(" > ")[0] for line in group.commands[command].epilog.splitlines() if "microrad" in line]
    for line in lines:
        _, name, *args = shlex.split(line)
        group.commands[name].make_context(name, args)


@pytest.mark.promise("index-1")
@pytest.mark.promise("releasing-9")
def test_help_lists_every_command_and_completion(call):
    result = call("--help")
    assert "Exit code: 0 done, 1 a requirement is not met, 2 bad usage or a bad file." in " ".join(result.out.split())
    assert result.code == 0
    listed = {line.split()[0] for line in result.out.partition("Commands:")[2].splitlines() if line.startswith("  ")}
    assert set(COMMANDS) <= listed
    assert {c.name or c.callback.__name__ for c in cli.app.registered_commands} == set(COMMANDS)
    for text in ("--install-completion", "--show-completion", "--version", "Examples:", "Exit code"):
        assert text in result.out


def test_identify_says_how_columns_are_counted(call):
    assert "counted from 0" in " ".join(call("identify", "--help").out.split())


@pytest.mark.promise("readme-5")
@pytest.mark.parametrize("command", COMMANDS)
@pytest.mark.promise("readme-23")
def test_readme_names_every_command(command):
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    if not text.strip():
        pytest.skip("README.md has no content yet")
    assert f"microrad {command}" in text


@pytest.mark.promise("decisions-1")
def test_help_loads_nothing_heavy():
    heavy = ["numpy", "scipy", "numba", "pydantic", "xarray", "contourpy", "h5py", "rich", "jinja2"]
    code = f"import sys, microrad, microrad.cli; print([m for m in {heavy} if m in sys.modules])"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout == "[]\n"


def test_version(call):
    assert call("--version") == (0, f"microrad {microrad.__version__}\n", "")


@pytest.mark.parametrize(
    ("args", "words"),
    [
        (["simulat"], "No such command"),
        (["idenfity"], "identify"),
        (["run"], "Missing argument"),
        (["run", "a.toml", "--ouput", "x"], "--output"),
        (["identify", "a.csv", "--input", "0"], "--output"),
    ],
)
def test_bad_usage_is_refused(refused, args, words):
    assert words in refused(*args)


# --------------------------------------------------------------------------------------------------------------- init
@pytest.mark.promise("readme-5")
@pytest.mark.promise("index-2")
@pytest.mark.promise("readme-23")
def test_init_writes_the_packaged_mission_and_the_next_command(call, folder):
    assert call("init") == (0, "leo-geo.toml written. Next: microrad run leo-geo.toml\n", "")
    assert listing(folder) == {"leo-geo.toml": PAPER.read_bytes()}
    assert "microrad run 'my mission.toml'" in call("init", "my mission.toml").out


def test_init_never_overwrites(refused, folder):
    (folder / "leo-geo.toml").write_text("mine")
    message = refused("init")
    for words in ("leo-geo.toml exists and is left as it is", "microrad init other.toml", "microrad run leo-geo.toml"):
        assert words in message


def test_init_refuses_a_folder_that_is_not_there_or_is_one(refused, folder):
    assert "there is no folder nowhere; create it first" in refused("init", "nowhere/a.toml")
    (folder / "here").mkdir()
    assert "here exists and is left as it is" in refused("init", "here")


def test_a_full_disk_leaves_no_part_of_a_file(refused, monkeypatch):
    def full(self, target):
        raise OSError(errno.ENOSPC, "No space left on device", str(target))

    monkeypatch.setattr(Path, "replace", full)
    message = refused("init")
    assert "leo-geo.toml: No space left on device; nothing was written" in message


# ---------------------------------------------------------------------------------------------------------------- run
@pytest.mark.promise("readme-1", "readme-5", "report-1")
@pytest.mark.promise("index-1", "index-2")
@pytest.mark.promise("readme-23")
def test_init_then_run(call, folder):
    """Without the fine-pointing loop and the day: the whole is run by test_docs_gallery.py."""
    call("init")
    mission(Path("leo-geo.toml"))
    result = call("run", "leo-geo.toml", "--exit-on", "closes")
    assert (result.code, result.err) == (0, "")
    assert result.out.startswith("Not every requirement is met: residual pointing error (")
    for name in ("report.html", "results.nc", "manifest.json"):
        path = Path("leo-geo-study") / name
        assert str(path) in result.out
        assert path.stat().st_size > 0
    assert sorted(p.name for p in folder.iterdir()) == ["leo-geo-study", "leo-geo.toml"]


@pytest.mark.promise("gallery-9", "readme-1", "readme-5", "report-1", "report-7")
@pytest.mark.usefixtures("undrawn")
@pytest.mark.promise("readme-23")
def test_identify_then_run_on_the_mirror_it_wrote(call, refused, folder, loop_mirror, plain):
    args = ("run", plain, "--mirror", loop_mirror, "--json")
    result = call(*args)
    assert (result.code, result.err) == (1, "")
    summary = json.loads(result.out)
    assert (summary["closes"], summary["met"]) == (True, False)
    assert summary["folder"] == "leo-geo-study"
    assert loop_mirror.name in (folder / "leo-geo-study" / "manifest.json").read_text(encoding="utf-8")
    *power, residual, margin = summary["requirements"]
    assert all(r["met"] == (r["margin"] >= 0) for r in power)
    for r in (residual, margin):  # of a loop around a mirror whose dynamics were not recorded
        assert (r["margin"] > 0, r["met"]) == (True, False)
        assert r["limited_by"] == "dynamics of the mirror, which its model does not have"

    assert "replace them with --overwrite" in refused(*args)
    (folder / "leo-geo-study" / "report.html").write_text("old")
    assert call(*args, "--overwrite", "--exit-on", "closes").code == 0
    assert (folder / "leo-geo-study" / "report.html").stat().st_size > 1000


@pytest.mark.promise("readme-5", "report-1", "report-7")
@pytest.mark.usefixtures("undrawn")
def test_a_run_that_meets_every_requirement_is_exit_0(call, folder, monkeypatch, plain_found):
    """That the mission of `microrad init` meets its own is shown by test_docs_report.py."""
    assert not all(each.met for each in plain_found.requirements)
    kept = [each if each.met else replace(each, margin=1.0) for each in plain_found.requirements]
    found = replace(plain_found, requirements=tuple(kept))
    monkeypatch.setattr(study, "run_study", lambda *args: found)
    result = call("run", PAPER)
    assert (result.code, result.err) == (0, "")
    assert "and every requirement is met." in " ".join(result.out.split())
    assert (folder / "leo-geo-study" / "report.html").is_file()
    first, beacon, *others = found.requirements
    missed = replace(found, requirements=(first, replace(beacon, margin=-1.0), *others))
    monkeypatch.setattr(study, "run_study", lambda *args: missed)
    assert call("run", PAPER, "--overwrite").code == 1
    assert call("run", PAPER, "--overwrite", "--exit-on", "closes").code == 0


@pytest.mark.promise("report-1", "report-7")
@pytest.mark.usefixtures("undrawn")
def test_a_link_that_does_not_close_is_exit_1_and_has_its_report(call, folder, loop_mirror):
    dim = mission(folder / "dim.toml", ('required_power = "10 pW"', 'required_power = "1 nW"'))
    result = call("run", dim, "--mirror", loop_mirror, "--output", "results/first")
    assert result.code == 1
    assert "does not close" in result.out
    assert (folder / "results" / "first" / "report.html").is_file()


@pytest.fixture
def few_controllers(monkeypatch):
    """Designs of two families, and of each that goes without saying."""
    monkeypatch.setattr(designs, "families", lambda m: (control.PI, control.LQG))


@pytest.fixture
def designed_once(monkeypatch):
    """Controllers of the one mission of a test, designed once for all that is printed of them."""
    made, design = [], controller_study.design_and_promise

    def known(scene, on_progress, only):
        made[:] = made or [design(scene, on_progress, only)]
        return made[0]

    monkeypatch.setattr(controller_study, "design_and_promise", known)


@pytest.mark.promise("choose-6")
@pytest.mark.promise("readme-5")
@pytest.mark.promise("pointing-1", "pointing-2")
@pytest.mark.usefixtures("few_controllers", "designed_once")
@pytest.mark.promise("readme-23")
def test_design_prints_each_controller_with_its_margins(call, folder):
    call("init")
    result = call("design", "leo-geo.toml")
    for words in ("PI, best of a gain grid", "LQG", "PI + inverse in series", "modulus", "integral frequency"):
        assert words in result.out
    data = json.loads(call("design", "leo-geo.toml", "--json").out)
    far = [c["simulated_rms_rad_per_axis"] > 1.5 * c["residual_rms_rad_per_axis"] for c in data["controllers"]]
    assert any(far) == ("Warning" in result.out) == bool(data["warnings"])
    assert (result.code, result.err) == (any(far), "")
    assert all(c["margins"]["modulus"] >= 0.5 for c in data["controllers"])
    assert len(data["controllers"][0]["matrices"]["A"]) == 2  # an integrator an axis


@pytest.mark.usefixtures("designed_once")
def test_design_says_when_nothing_is_known_of_the_mirrors_dynamics(call, folder, loop_mirror, monkeypatch):
    monkeypatch.setattr(designs, "names", lambda m: (designs.BASELINE,))
    monkeypatch.setattr(designs, "DRAWS", 1)
    call("init")
    result = call("design", "leo-geo.toml", "--mirror", loop_mirror)
    assert result.code == 0
    said = " ".join(result.out.split())
    assert "Warning: the model of the mirror has no linear part, so its resonances and its lag are not" in said
    assert len(json.loads(call("design", "leo-geo.toml", "--mirror", loop_mirror, "--json").out)["warnings"]) == 1


def test_design_refuses_what_it_cannot_design(refused, folder, plain):
    assert "no table [fine_pointing]: microrad init writes one" in refused("design", plain)
    text = PAPER.read_text(encoding="utf-8").replace("modulus_margin = 0.5 ", "modulus_margin = 0.99 ")
    (folder / "hard.toml").write_text(text, encoding="utf-8")
    message = refused("design", "hard.toml")
    assert "hard.toml" in message and "modulus margin" in message


@pytest.mark.promise("readme-5", "report-1")
def test_run_refuses_missing_and_faulty_files(refused, folder):
    assert "no-such.toml" in refused("run", "no-such.toml")
    faulty = mission(
        folder / "faulty.toml", ('error = "300 urad"                    # paper: section 2.1', "error = 300 # paper")
    )
    message = refused("run", faulty)
    for words in ("pointing.lines.body_pointing.error", "line ", "without a unit"):
        assert words in message
    assert "no-mirror.toml" in refused("run", PAPER, "--mirror", "no-mirror.toml")


@pytest.mark.promise("report-1")
def test_run_never_replaces_what_it_did_not_write_and_says_so_before_computing(refused, folder, monkeypatch):
    monkeypatch.setattr(study, "run_study", lambda *args: pytest.fail("computed first"))
    (folder / "photos").mkdir()
    (folder / "photos" / "a.jpg").write_text("mine")
    for extra in ([], ["--overwrite"]):
        assert "photos holds files that are not results of microrad" in refused(
            "run", PAPER, "--output", "photos", *extra
        )
    assert "a.jpg is a file, not a folder" in refused("run", PAPER, "--output", "photos/a.jpg")


def test_run_refuses_an_unstable_loop_and_a_mirror_without_inverse(refused, folder, plain):
    unstable = mission(folder / "wild.toml", ('integral = "16000 V/(mrad s)"', 'integral = "1600000 V/(mrad s)"'))
    message = refused("run", unstable)
    assert "wild.toml: the closed loop is unstable" in message
    assert "lower the gains" in message
    stuck = folder / "stuck.toml"
    stuck.write_text(
        'name = "stuck"\ntravel = "1 mrad"\ncomposition = "static"\nrate_limit = "100 V/s"\n'
        'bias = "6 V"\ndrive_min = "0 V"\ndrive_max = "12 V"\n'
        '[prandtl_ishlinskii]\nthresholds = ["0 V", "1 V"]\nweights = ["0 mrad/V", "0.089 mrad/V"]\n'
    )
    assert "has no inverse" in refused("run", plain, "--mirror", stuck)


@pytest.mark.promise("report-1", "report-3")
def test_a_full_disk_during_run_leaves_nothing_but_the_verdict(call, folder, monkeypatch, loop_mirror, plain):
    def full(*args, **kwargs):
        raise OSError(errno.ENOSPC, "No space left on device")

    before = listing(folder)
    monkeypatch.setattr(report, "columns_csv", full)
    result = call("run", plain, "--mirror", loop_mirror)
    assert (result.code, result.err.count("\n")) == (2, 1)
    assert "No space left on device; nothing was written" in result.err
    assert result.out.startswith("Not every requirement is met: ")
    assert listing(folder) == before


@pytest.mark.promise("report-5")
@pytest.mark.usefixtures("undrawn")
def test_a_cache_folder_that_cannot_be_used_is_told_once_and_the_run_goes_on(call, folder, monkeypatch, plain_found):
    (folder / "cache").write_text("no folder", encoding="utf-8")
    monkeypatch.delenv("MICRORAD_KEEP")
    monkeypatch.setenv("XDG_CACHE_HOME", str(folder / "cache"))
    monkeypatch.setattr(study, "run_study", lambda *args: plain_found)
    result = call("run", PAPER)
    assert result.code == 1  # of the paper's loop
    assert result.err.count("\n") == 1
    assert str(folder / "cache") in result.err
    assert "nothing is kept for a quicker next run" in result.err
    assert (folder / "leo-geo-study" / "report.html").is_file()


@pytest.mark.promise("report-5")
@pytest.mark.usefixtures("undrawn")
def test_a_cache_folder_that_cannot_be_written_is_told_once_and_the_run_goes_on(call, folder, monkeypatch, plain_found):
    access = os.access
    monkeypatch.delenv("MICRORAD_KEEP")
    monkeypatch.setenv("XDG_CACHE_HOME", str(folder / "cache"))
    monkeypatch.setattr(study, "run_study", lambda *args: plain_found)
    monkeypatch.setattr(os, "access", lambda path, mode: Path(path).name != "parts" and access(path, mode))
    result = call("run", PAPER)
    place = folder / "cache" / "microrad" / "parts"
    said = f"microrad: {place}: the folder cannot be written: nothing is kept for a quicker next run\n"
    assert (result.code, result.err) == (1, said)
    assert (folder / "leo-geo-study" / "report.html").is_file()
    assert list(place.iterdir()) == []


def test_a_report_is_written_although_nobody_reads_the_verdict(folder):
    """As in `microrad run … | head -1`: the first print already finds a pipe that is closed."""
    code = """
import sys
from microrad.cli import app, frame

@app.command()
@frame.command
def late():
    return frame.Outcome("verdict", 0, afterwards=lambda: open("report", "w").write("whole") and "written")

sys.argv = ["microrad", "late"]
frame.main()
"""
    reader, writer = os.pipe()
    os.close(reader)
    late = [sys.executable, "-c", code]
    run = subprocess.run(late, stdout=writer, stderr=subprocess.PIPE, text=True, cwd=folder, check=False)
    os.close(writer)
    assert (run.returncode, run.stderr) == (141, "")
    assert (folder / "report").read_text() == "whole"


def test_a_named_file_that_is_missing_is_told_by_the_study_where_parts_are_kept_too(refused, folder, monkeypatch):
    monkeypatch.delenv("MICRORAD_KEEP")
    monkeypatch.setenv("XDG_CACHE_HOME", str(folder.parent / "cache"))
    text = without_fine_pointing(PAPER.read_text("utf-8"))
    assert text.count("runs = 4000") == 1
    text = text.replace("runs = 4000", "runs = 100")
    begin, end = text.index('kind = "circular"'), text.index("[orbit.leo.limits]")
    Path("gone.toml").write_text(f'{text[:begin]}kind = "elements"\nfile = "absent.tle"\n\n{text[end:]}', "utf-8")
    assert refused("run", "gone.toml").startswith("microrad: gone.toml: orbit.leo: absent.tle: there is no such file")


def test_an_unexpected_exception_asks_for_a_report(call, folder, monkeypatch):
    def broken(*args):
        raise RuntimeError("a bolt fell off")

    monkeypatch.setattr(study, "run_study", broken)
    result = call("run", PAPER)
    assert (result.code, result.out) == (70, "")
    for words in ("Traceback", "a bolt fell off", "microrad doctor", "report the lines above"):
        assert words in result.err
    assert listing(folder) == {}


# A run that says when it has come to a function.
MARKED = """
import sys
from microrad import cli
from {package} import {module}
real = {module}.{function}
def marked(*args):
    print("here", file=sys.stderr, flush=True)
    return real(*args)
{module}.{function} = marked
cli.main()
"""


@pytest.fixture
def interruptible():
    """Take interrupts here and in what is started, also where the tests themselves run in the background."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.promise("report-1", "report-3")
@pytest.mark.usefixtures("interruptible")
@pytest.mark.parametrize(
    ("name", "package", "module", "function"),
    [
        pytest.param("SIGINT", "microrad.study", "study", "run_study", marks=pytest.mark.endurance),
        ("SIGTERM", "microrad", "report", "columns_csv"),
    ],
)
def test_an_interrupt_during_run_leaves_nothing(
    folder, loop_mirror, plain, name, package, module, function, tmp_path_factory
):
    code = MARKED.format(package=package, module=module, function=function)
    args = [sys.executable, "-c", code, "run", str(plain)]
    args += ["--mirror", str(loop_mirror)] if module == "report" else []
    progress = tmp_path_factory.mktemp("progress") / "progress"
    environment = os.environ | {frame.PROGRESS_FILE: str(progress)}
    process = subprocess.Popen(args, env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    assert process.stderr.readline() == "here\n"
    lines_of(progress, 2 if module == "study" else 0)  # the study is in its second step
    process.send_signal(getattr(signal, name))
    out, err = process.communicate(timeout=HANG_S)
    assert (process.returncode, out.startswith("Not every requirement is met: ")) == (130, module == "report"), out
    assert err.replace("here\n", "") == "microrad: interrupted, nothing was written\n"
    assert listing(folder) == {}


def test_after_an_interrupt_nothing_is_taken_apart(folder):
    """What the compiler was loading is in pieces, and to dispose of it may crash."""
    code = """
import atexit
from microrad.cli import app, frame

@app.command()
@frame.command
def stopped():
    print("half a line", end="")
    raise KeyboardInterrupt

atexit.register(print, "taken apart")
frame.main()
"""
    run = [sys.executable, "-c", code, "stopped"]
    ended = subprocess.run(run, capture_output=True, text=True, check=False)
    assert (ended.returncode, ended.stdout) == (130, "half a line")
    assert ended.stderr == "microrad: interrupted, nothing was written\n"


@pytest.mark.usefixtures("interruptible")
def test_an_interrupt_that_falls_into_a_call_back_is_not_lost(monkeypatch):
    @ctypes.CFUNCTYPE(None)
    def call_back():
        raise KeyboardInterrupt

    monkeypatch.setattr(sys, "unraisablehook", frame.interrupt_again)
    call_back()  # what ctypes cannot raise it hands to the hook
    with pytest.raises(KeyboardInterrupt):  # it falls between two steps of Python, and wakes nobody
        until(lambda: False, "the interrupt")


def test_what_else_cannot_be_raised_is_reported(monkeypatch, capsys):
    @ctypes.CFUNCTYPE(None)
    def call_back():
        raise ValueError("from below")

    monkeypatch.setattr(sys, "unraisablehook", frame.interrupt_again)
    call_back()
    assert "ValueError: from below" in capsys.readouterr().err


def test_an_interrupt_behind_another_error_is_an_interrupt(call, folder, monkeypatch):
    def interrupted(*args):
        try:
            raise KeyboardInterrupt
        except KeyboardInterrupt:
            raise ImportError("half a module") from None

    monkeypatch.setattr(study, "run_study", interrupted)
    assert call("run", PAPER) == (130, "", "microrad: interrupted, nothing was written\n")


# ----------------------------------------------------------------------------------------------------------- identify
@pytest.mark.promise("identify-2")
@pytest.mark.promise("readme-5")
@pytest.mark.promise("readme-23")
def test_identify_prints_both_models_and_writes_the_mirror(call, folder):
    result = call("identify", write_recording(folder / "loop.csv"), *COLUMNS)
    assert (result.code, result.err) == (0, "")
    for words in ("prandtl_ishlinskii predicts", "straight line", "loop.csv (", "holds for drives from 0 V to 12 V"):
        assert words in " ".join(result.out.split())
    assert len(result.out.splitlines()) <= 25
    assert "loop-mirror.toml written (prandtl_ishlinskii)" in result.out
    assert "microrad run leo-geo.toml --mirror loop-mirror.toml --output loop-mirror-study" in result.out
    text = (folder / "loop-mirror.toml").read_text(encoding="utf-8")
    assert text.startswith(lab.MIRROR_FILE_BEGINS)
    assert 'name = "loop"' in text
    assert sorted(p.name for p in folder.iterdir()) == ["loop-mirror.html", "loop-mirror.toml", "loop.csv"]


@pytest.mark.promise("identify-13")
@pytest.mark.usefixtures("undrawn")
@pytest.mark.parametrize(("options", "hold"), [([], "zero-order"), (["--measured-drive"], "first-order")])
def test_identify_is_told_what_the_drive_does_between_samples(refused, folder, monkeypatch, options, hold):
    def fit(*_, **options):
        raise identify.IdentificationError(f"asked with {options['hold']}")

    monkeypatch.setattr("microrad.lab.identify.identify", fit)
    assert f"asked with {hold}" in refused("identify", write_recording(folder / "loop.csv"), *COLUMNS, *options)


def test_identify_json_names_and_models(call, folder):
    path = write_recording(folder / "loop.csv", reverse=True)
    options = (
        "--static",
        "--model",
        "bouc-wen",
        "--admissible",
        "--name",
        "lab mirror",
        "--mirror-file",
        "lab.toml",
        "--json",
    )
    result = call("identify", path, "--input", 1, "--output", 2, "--rate", "1 kHz", "--output-unit", "um",
                  "--lever-arm", "50 mm", *options)  # fmt: skip
    assert (result.code, result.err) == (0, "")
    found = json.loads(result.out)
    assert (found["model"], found["mirror_file"]) == ("bouc_wen_admissible", "lab.toml")
    assert [score["model"] for score in found["scores"]] == [
        "prandtl_ishlinskii",
        "bouc_wen_admissible",
        "straight line",
    ]
    parameters = found["parameters"]["bouc_wen_admissible"]
    # about 0.09 um/V over 50 mm, falling with the drive
    assert -2.1e-6 < parameters["d1"]["value"] < -1.5e-6
    assert parameters["d1"]["unit"] == "rad/V"
    assert parameters["admissible"] is True
    assert 'name = "lab mirror"' in (folder / "lab.toml").read_text(encoding="utf-8")


@pytest.mark.promise("recordings-1")
@pytest.mark.parametrize(
    ("text", "rate_hz"), [("200", 200.0), ("200 Hz", 200.0), ("50 kHz", 50e3), ("1e3", 1e3), ("0.5MHz", 5e5)]
)
def test_rates_with_and_without_unit(text, rate_hz):
    assert lab._rate(text) == rate_hz


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (["--rate", "5 m"], ["--rate", "another kind of quantity"]),
        (["--rate", "fast"], ["--rate", "plain number"]),
        (["--rate", "-5"], ["sample rate is -5.0"]),
        (["--rate", "nan"], ["--rate", "plain number"]),
        (["--input", "drvie"], ["no input column is named 'drvie'", "nearest is 'drive'"]),
        (["--output", "7"], ["no output column 7", "numbered from 0 to 2"]),
        (["--output", "drive"], ["input and output are both"]),
        (["--output-unit", "um"], ["lever"]),
        (["--output-unit", "grad"], ["output unit 'grad' is not known"]),
        (["--lever-arm", "50"], ["--lever-arm", "without a unit", "50 m"]),
        (["--lever-arm", "50 mm"], ["already an angle"]),
        (["--hold-out", "1.5"], ["--hold-out (hold_out) is 1.5", "between 0 and 1"]),
        (["--model", "magic"], ["magic", "bouc-wen"]),
        (["--seed", "-1"], ["--seed", "0"]),
        (["--name", " "], ["has no name"]),
        (["--mirror-file", "nowhere/m.toml"], ["there is no folder nowhere"]),
    ],
)
def test_identify_refusals(refused, folder, change, words):
    message = " ".join(refused("identify", write_recording(folder / "loop.csv"), *COLUMNS, *change).split())
    for word in words:
        assert word in message


HOSTILE = "be\x1b[31mnch/dr\x9bive\u202e"


def hostile_hdf5(path):
    with h5py.File(path, "w") as file:
        file[HOSTILE] = np.arange(100.0)


def hostile_tdms(path):
    with TdmsWriter(path) as file:
        file.write_segment([ChannelObject(*HOSTILE.split("/"), np.arange(100.0), {"wf_increment": 0.001})])


def hostile_csv(path):
    path.write_text(HOSTILE + ",angle\n" + "".join(f"{k},{k}\n" for k in range(100)), "utf-8")


@pytest.mark.parametrize(
    ("write", "name"), [(hostile_hdf5, "a.h5"), (hostile_tdms, "a.tdms"), (hostile_csv, "a\x1b[31m.csv")]
)
def test_names_from_files_reach_the_terminal_spelled_out(refused, folder, write, name):
    write(folder / name)
    message = refused("identify", folder / name, "--input", "nope", "--output", "angle", "--static")
    assert "ive\\u202e'" in message
    assert all(c.isprintable() or c == "\n" for c in message)


def test_what_is_printed_is_spelled_out_but_for_pages(capsys):
    assert frame._printed("a\x1b[2J\tb\u00a0c\n", 0) == 0
    assert frame._printed("<!doctype html>\x01\n", 0) == 0
    assert capsys.readouterr().out == "a\\u001b[2J\tb\u00a0c\n\n<!doctype html>\x01\n\n"


def test_identify_refuses_files_that_are_no_recordings(refused, folder):
    assert "there is no such file" in refused("identify", "lost.csv", *COLUMNS)
    path = write_recording(folder / "loop.csv")
    lines = path.read_text().splitlines()
    lines[9] = "0.008,nan,0.1"
    path.write_text("\n".join(lines))
    assert "line 10" in refused("identify", path, *COLUMNS)


@pytest.mark.usefixtures("undrawn")
def test_identify_replaces_only_mirror_files_and_only_when_told(call, refused, folder):
    path = write_recording(folder / "loop.csv")
    mine = folder / "loop-mirror.toml"
    mine.write_text("# written by hand\n")
    assert "replace it with --overwrite" in refused("identify", path, *COLUMNS)
    assert "was not written by microrad" in refused("identify", path, *COLUMNS, "--overwrite")
    assert "was not written by microrad" in refused("identify", path, *COLUMNS, "--overwrite", "--mirror-file", path)
    mine.write_text(f"{lab.MIRROR_FILE_BEGINS} an older recording\n")
    assert call("identify", path, *COLUMNS, "--overwrite").code == 0
    assert "loop.csv" in mine.read_text(encoding="utf-8")


def test_identify_looks_at_the_mirror_file_before_and_after_fitting(call, refused, folder, monkeypatch):
    (folder / "lost-mirror.toml").write_text("mine")
    assert "lost-mirror.toml exists" in refused("identify", "lost.csv", *COLUMNS)

    def meanwhile(*args, **kwargs):
        (folder / "loop-mirror.toml").write_text("mine")
        return "text"

    path = write_recording(folder / "loop.csv")
    monkeypatch.setattr(identify, "mirror_file_text", meanwhile)
    result = call("identify", path, *COLUMNS)
    assert (result.code, result.out) == (2, "")
    assert "loop-mirror.toml exists" in result.err
    assert (folder / "loop-mirror.toml").read_text() == "mine"


@pytest.mark.promise("readme-5")
@pytest.mark.usefixtures("undrawn")
def test_progress_goes_to_a_terminal_and_never_to_stdout(call, folder, monkeypatch):
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    monkeypatch.setenv("TERM", "xterm")
    result = call("identify", write_recording(folder / "loop.csv"), *COLUMNS, "--json")
    assert result.code == 0
    assert json.loads(result.out)["model"]
    assert "bouc_wen" in result.err  # the last one, whichever process fitted it


@pytest.mark.usefixtures("undrawn")
def test_progress_goes_to_a_file_that_the_environment_names(call, folder, monkeypatch):
    monkeypatch.setenv(frame.PROGRESS_FILE, str(folder / "progress"))
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    (folder / "progress").write_text('{"of": "a run before"}\n')
    began_s = time.time()
    result = call("identify", write_recording(folder / "loop.csv"), *COLUMNS, "--json")
    assert (result.code, result.err) == (0, "")
    before, *notes = [json.loads(line) for line in (folder / "progress").read_text("utf-8").splitlines()]
    assert before == {"of": "a run before"}
    assert notes[-1]["done"] == notes[-1]["total"]
    assert "Bouc-Wen starts" in {note["what"] for note in notes}
    times = [began_s - 1.0, *(note["at"] for note in notes), time.time() + 1.0]
    assert times == sorted(times)


def test_a_file_of_progress_has_a_line_for_each_phase_and_no_flood(folder, monkeypatch):
    monkeypatch.setenv(frame.PROGRESS_FILE, str(folder / "progress"))
    monkeypatch.setattr(frame, "_PROGRESS_S", 3600.0)
    with frame.progress_bar() as progress:
        for done in range(1, 101):
            progress(done, 100, "rows")
        progress(0, 100, "µ")
        progress(1, 100, "µ")
        progress(0, 4, "µ")
    notes = [json.loads(line) for line in (folder / "progress").read_text("utf-8").splitlines()]
    assert [(note["done"], note["total"], note["what"]) for note in notes] == [
        (1, 100, "rows"),
        (100, 100, "rows"),
        (0, 100, "µ"),
        (0, 4, "µ"),
    ]


def test_a_file_of_progress_begins_anew_before_it_fills_the_disk(folder, monkeypatch):
    monkeypatch.setenv(frame.PROGRESS_FILE, str(folder / "progress"))
    monkeypatch.setattr(frame, "_PROGRESS_BYTES", 1000)
    with frame.progress_bar() as progress:
        for done in range(200):
            progress(done, 200, f"row {done}")
            assert (folder / "progress").stat().st_size < 1200
    lines = (folder / "progress").read_text("utf-8").splitlines()
    assert json.loads(lines[-1])["done"] == 199
    assert 1 <= len(lines) < 20


def test_a_file_of_progress_that_cannot_be_written_is_refused(call, folder, monkeypatch):
    monkeypatch.setenv(frame.PROGRESS_FILE, str(folder / "none" / "progress"))
    result = call("identify", write_recording(folder / "loop.csv"), *COLUMNS)
    assert (result.code, result.out) == (2, "")
    there = folder / "none" / "progress"
    assert f"microrad: {there}: No such file or directory; nothing was written there." in result.err


# --------------------------------------------------------------------------------------------------- doctor and schema
@pytest.mark.promise("readme-5")
@pytest.mark.skipif("NUMBA_DISABLE_JIT" in os.environ, reason="doctor calls switched-off compilation a problem")
@pytest.mark.promise("readme-23")
def test_doctor_finds_this_installation_in_order(call):
    result = call("doctor")
    assert (result.code, result.err) == (0, ""), result.out
    assert all(line.startswith(("ok ", " " * 9)) for line in result.out.splitlines())
    assert all(len(line) <= 80 or len(line.split()) == 1 for line in result.out.splitlines())
    for words in ("python", "numba", "loop width 14.05 %", "74.44 µrad", "is writable", "leo-geo.toml"):
        assert words in " ".join(result.out.split())


def test_doctor_names_what_is_wrong_and_what_to_do(call, monkeypatch):
    def gone():
        raise ImportError("no module named yesterday")

    monkeypatch.setattr(installation, "LOOP_WIDTH_PERCENT", 14.0)
    monkeypatch.setattr(installation, "_mission", gone)
    result = call("doctor", "--json")
    assert (result.code, result.err) == (1, "")
    found = json.loads(result.out)
    assert found["ok"] is False
    wrong = {check["name"]: check for check in found["checks"] if not check["ok"]}
    assert {"kernels", "packaged mission"} <= set(wrong)
    assert not {"python", "microrad", "numpy"} & set(wrong)
    assert "NUMBA_CACHE_DIR" in wrong["kernels"]["advice"]
    assert wrong["packaged mission"]["found"] == "ImportError: no module named yesterday"
    assert "problem  kernels" in call("doctor").out


@pytest.mark.parametrize(
    ("version", "wanted", "fits"),
    [
        ("3.11.0", ">=3.11", True),
        ("3.10.9", ">=3.11", False),
        ("3.13.9", ">=3.11,<3.14", True),
        ("3.14.0", ">=3.11, <3.14", False),
        ("3.10.0", ">=3.11,<3.14", False),
        ("3.14.0", "<3.14", False),
        ("3.13.0", "<3.14", True),
        ("2.7.0", "", True),
    ],
)
def test_doctor_knows_which_pythons_are_supported(monkeypatch, version, wanted, fits):
    monkeypatch.setattr(installation.metadata, "metadata", lambda name: {"Requires-Python": wanted})
    monkeypatch.setattr(installation.platform, "python_version", lambda: version)
    assert installation._python() == (fits, f"{version} ({sys.executable}), wanted {wanted}")


@pytest.mark.parametrize(
    ("version", "fits"), [("2.4", True), ("2.4.0", True), ("2.3.9", False), ("2.10.1", True), ("2.4rc1", True)]
)
def test_doctor_takes_the_oldest_library_that_is_wanted(monkeypatch, version, fits):
    monkeypatch.setattr(installation.metadata, "version", lambda name: version)
    assert installation._library("json", "2.4") == (fits, f"{version}, wanted 2.4 or later")


@pytest.mark.parametrize(
    ("width", "largest", "agrees"), [(14.056, 74.446, True), (14.07, 74.44, False), (14.05, 74.42, False)]
)
def test_both_numbers_of_the_compiled_kernels_have_to_be_the_known_ones(monkeypatch, width, largest, agrees):
    from microrad.mirror import hysteresis

    loop = SimpleNamespace(width=width / 100.0, hysteresis_rad=np.array([0.0, -1e-6 * largest, 1e-6]))
    monkeypatch.setattr(hysteresis, "BoucWen", lambda *args: SimpleNamespace(loop=lambda *args: loop))
    assert installation._kernels() == (
        agrees,
        f"loop width {width:.2f} % (known: 14.05 %), max|h| {largest:.2f} µrad (known: 74.44 µrad)",
    )


def test_doctor_says_that_compilation_is_switched_off_and_makes_the_folder_of_the_cache(monkeypatch, tmp_path):
    from microrad.core import kernels

    monkeypatch.setattr(kernels, "closed_loop", lambda: None)
    assert installation._cache() == (
        False,
        "compilation is switched off by NUMBA_DISABLE_JIT: unset it, or a study takes hours",
    )
    place = tmp_path / "a" / "cache"
    monkeypatch.setattr(kernels, "closed_loop", SimpleNamespace(stats=SimpleNamespace(cache_path=str(place))))
    assert installation._cache() == (True, f"{place} is writable") and list(place.iterdir()) == []


def test_doctor_finds_an_old_library(monkeypatch):
    monkeypatch.setattr(
        installation.metadata,
        "requires",
        lambda name: ["numpy>=99.1", "notthere>=1", "typer", 'ruff>=1; extra == "test"'],
    )
    old, absent = list(installation._libraries())[1:]
    assert (old.ok, absent.ok) == (False, False)
    assert "wanted 99.1" in old.found
    assert old.advice == "python -m pip install 'numpy>=99.1'"
    assert "notthere" in absent.found


@pytest.mark.promise("readme-5")
@pytest.mark.promise("readme-23")
def test_schema_is_one_json_document(call):
    result = call("schema")
    assert (result.code, result.err) == (0, "")
    assert "data_rate" in json.loads(result.out)["$defs"]["Communication"]["properties"]


@pytest.mark.promise("readme-5")
@pytest.mark.promise("readme-23")
def test_explain_says_what_a_key_means_as_text_and_as_json(call):
    result = call("explain", "fine_pointing.modulus_margin")
    assert (result.code, result.err) == (0, "")
    assert result.out.startswith("fine_pointing.modulus_margin (mission file)\n  means     least distance of the loop")
    (key,) = json.loads(call("explain", "fine_pointing.modulus_margin", "--json").out)
    assert (key["name"], key["default"]) == ("fine_pointing.modulus_margin", "")
    refused = call("explain", "modulus_margn")
    assert (refused.code, refused.out) == (2, "")
    assert "near it are modulus_margin" in refused.err


def test_a_closed_pipe_is_silent_and_a_full_one_is_not():
    closed = subprocess.run(
        ["/bin/sh", "-c", f"{sys.executable} -m microrad schema | head -c 1"],
        capture_output=True,
        text=True,
        check=True,
    )
    assert (closed.stdout, closed.stderr) == ("{", "")
    if not Path("/dev/full").exists():
        return
    with Path("/dev/full").open("w") as full:
        result = subprocess.run([*MICRORAD, "schema"], stdout=full, stderr=subprocess.PIPE, text=True, check=False)
    assert (result.returncode, result.stderr) == (
        2,
        "microrad: the output cannot be written: No space left on device\n",
    )


# ------------------------------------------------------------------------------------------------------- public screen
@pytest.mark.promise("readme-22")
def test_every_public_name_exists_once():
    modules = {module.name for module in pkgutil.iter_modules(microrad.__path__)}
    assert not modules & set(microrad._PUBLIC), "a public name would hide the module of that name"
    assert len(set(microrad._PUBLIC.values())) == len(microrad._PUBLIC)
    for name, place in microrad._PUBLIC.items():
        module, _, attribute = place.rpartition(".")
        assert getattr(microrad, name) is getattr(importlib.import_module(f"microrad.{module}"), attribute)
    assert dir(microrad) == sorted([*microrad._PUBLIC, "__version__"])


def test_an_unknown_public_name_says_what_there_is():
    with pytest.raises(AttributeError, match=r"no public name 'launch'; it has BoucWen"):
        microrad.launch  # noqa: B018


# -------------------------------------------------------------------------------------------------------------- bench
PLAN = """name = "two loops"
formats = ["npz"]

[limits]
rate = "5 kHz"
drive_min = "0 V"
drive_max = "12 V"
slew = "20 V/ms"
samples_per_period = 10

[bench]
truth = "bouc-wen"

[bench.amplifier]
gain = 15
output_min = "0 V"
output_max = "180 V"
bandwidth = "5 kHz"
slew = "1 V/us"

[bench.converters]
bits = 16
drive_min = "-4 V"
drive_max = "16 V"
output_min = "-1 mrad"
output_max = "2 mrad"

[bench.sensor]
noise = "1 urad"
mains = "0 urad"
mains_frequency = "50 Hz"
drift = "0 nrad/s"

[excitation.loop]
kind = "sines"
frequencies = ["60 Hz", "80 Hz"]
amplitudes = ["6 V"]
periods = 12
offset = "6 V"

[excitation.unseen]
kind = "sines"
use = "validation"
frequencies = ["70 Hz"]
amplitudes = ["5 V"]
periods = 14
offset = "6 V"
"""


@pytest.mark.promise("bench-1", "bench-2")
@pytest.mark.promise("readme-10")
@pytest.mark.usefixtures("undrawn")
def test_bench_writes_recordings_that_identify_takes_as_a_folder(call, folder):
    (folder / "plan.toml").write_text(PLAN)
    made = call("bench", "plan.toml", "--seed", "3")
    assert (made.code, made.err) == (0, "")
    assert "3 files written. Next: microrad identify plan-bench" in made.out
    found = call("identify", "plan-bench", "--static", "--json")
    assert (found.code, found.err) == (0, "")
    data = json.loads(found.out)
    roles = {Path(r["path"]).stem: r["role"] for r in data["recordings"]}
    assert roles == {"loop-60hz": "loops", "loop-80hz": "loops", "unseen": "validation"}
    assert data["best_model"] == "bouc_wen"
    assert "virtual bench" in (folder / "plan-bench-mirror.html").read_text(encoding="utf-8")
    listed = json.loads(call("bench", "plan.toml", "--seed", "3", "--overwrite", "--json").out)
    assert [Path(f).name for f in listed["files"]] == ["loop-60hz.npz", "loop-80hz.npz", "unseen.npz"]
    manifest = folder / "plan-bench" / "manifest.json"
    manifest.write_text(manifest.read_text(encoding="utf-8").replace('"identification"', '"validation"'), "utf-8")
    unfitted = call("identify", "plan-bench", "--mirror-file", "other.toml")
    assert unfitted.code == 2
    assert "every recording is for validation: leave one to be fitted." in unfitted.err


def test_bench_refusals(refused, folder):
    (folder / "plan.toml").write_text(PLAN)
    assert "or one of mirror-characterisation, paper-experiment" in refused("bench", "paper-experimnt")
    (folder / "bad.toml").write_text(PLAN.replace('amplitudes = ["6 V"]', 'amplitudes = ["9 V"]'))
    message = refused("bench", "bad.toml")
    assert "loop" in message
    assert "12 V" in message
    (folder / "plan-bench").mkdir()
    (folder / "plan-bench" / "mine.txt").write_text("mine")
    assert "holds files that are not recordings of microrad" in refused("bench", "plan.toml", "--overwrite")
    assert "no manifest.json of microrad bench in it" in refused("identify", "plan-bench")
    assert "expected: a table [recording.NAME] for each recording, with its file" in refused("identify", "plan.toml")


def test_the_models_of_the_command_are_those_of_the_ladder():
    from microrad.lab.identify import MODELS

    assert {m.value.replace("-", "_") for m in lab.Model} == {"best", *MODELS}


# ---------------------------------------------------------------------------------- what the files say of themselves
def with_units(folder, header):
    path = write_recording(folder / "units.csv")
    path.write_text(path.read_text().replace("time,drive,angle", header))
    return path


@pytest.mark.promise("recordings-1")
@pytest.mark.usefixtures("undrawn")
def test_units_in_the_header_are_taken_and_said(call, folder):
    path = with_units(folder, "time,Drive (mV),Tilt (urad)")
    result = call("identify", path, "--input", 1, "--output", 2, "--rate", 1000, "--static")
    assert (result.code, result.err) == (0, "")
    assert "drive in mV (stated in the files), output in urad (stated in the files)" in result.out
    assert 'drive_max = "0.012 V"' in (folder / "units-mirror.toml").read_text(encoding="utf-8")


@pytest.mark.promise("recordings-1", "recordings-8")
@pytest.mark.usefixtures("undrawn")
def test_a_time_column_by_name_and_a_fault_that_is_taken_on(refused, folder):
    path = write_recording(folder / "creeping.csv")
    table = np.loadtxt(path, delimiter=",", skiprows=1)
    table[:, 2] += np.linspace(0.0, 3.0 * np.ptp(table[:, 2]), table.shape[0])
    np.savetxt(path, table, delimiter=",", header="clock,drive,angle", comments="", fmt="%.9g")
    words = ("identify", path, "--input", "drive", "--output", "angle", "--static")
    assert "give the rate (--rate, rate_hz) in Hz, or name the time column" in refused(*words)
    message = " ".join(refused(*words, "--time", "clock").split())
    assert "of its peak-to-peak, where the drive does not" in message
    assert "--accept drift" in message
    message = refused(*words, "--time", "clock", "--accept", "drift", "--output-unit", "rad")
    assert "drift" not in message and "a tilt of " in message  # it was read


@pytest.mark.promise("recordings-1")
@pytest.mark.usefixtures("undrawn")
def test_units_that_nobody_states_are_assumed_and_said(call, folder):
    result = call("identify", write_recording(folder / "loop.csv"), *COLUMNS)
    assert "drive in V (assumed, --input-unit says otherwise)" in result.out
    assert "output in mrad (assumed, --output-unit says otherwise)" in result.out


def test_units_that_contradict_each_other_are_refused(refused, folder):
    path = with_units(folder, "time,Drive (mV),Tilt (urad)")
    message = refused(
        "identify", path, "--input", 1, "--output", 2, "--rate", 1000, "--static", "--output-unit", "mrad"
    )
    assert "--output-unit is mrad and the files say urad" in message
    same = folder / "same.csv"
    same.write_text(path.read_text().replace("Tilt (urad)", "Tilt (mrad)"))
    message = refused(
        "identify", same, path, "--input", 1, "--output", 2, "--rate", 1000, "--static", "--output-unit", "mrad"
    )
    assert "--output-unit is mrad and the files say" in message


def test_one_recording_for_fit_and_validation_is_refused(refused, folder):
    path = write_recording(folder / "loop.csv")
    message = refused("identify", path, *COLUMNS, "--validate", path)
    assert "the same data as" in message
    assert "one that is not fitted" in message


def test_one_file_for_mirror_and_report_is_refused(refused, folder):
    path = write_recording(folder / "loop.csv")
    assert "both the mirror file and the report" in refused(
        "identify", path, *COLUMNS, "--mirror-file", "x.toml", "--report", "x.toml"
    )


def test_a_model_that_explains_nothing_unseen_is_refused(refused, folder):
    path = write_recording(folder / "loop.csv")
    rows = path.read_text().splitlines()
    noise = np.random.default_rng(5).standard_normal(len(rows))
    rows[751:] = [f"{r.rpartition(',')[0]},{n:.6g}" for r, n in zip(rows[751:], noise[751:], strict=True)]
    path.write_text("\n".join(rows))
    message = refused("identify", path, *COLUMNS)
    assert "do not support a model" in message
    assert "at most 50 % is a model" in message


def test_an_empty_file_is_replaced_and_a_foreign_one_is_not(tmp_path):
    path = tmp_path / "mirror.zip"
    for content, stays in ((b"", False), (b"PK and more", False), (b"a letter", True)):
        path.write_bytes(content)
        with pytest.raises(frame.Refusal, match="was not written by microrad") if stays else nullcontext():
            frame.check_target(path, "choose another name", overwrite=True, begins=b"PK")
    (tmp_path / "folder.zip").mkdir()
    with pytest.raises(frame.Refusal, match=r"folder\.zip was not written by microrad and is left as it is"):
        frame.check_target(tmp_path / "folder.zip", "choose another name", overwrite=True, begins=b"PK")


def test_without_a_stderr_progress_goes_nowhere(monkeypatch):
    monkeypatch.setattr(sys, "stderr", None)
    with frame.progress_bar(0.0) as progress:
        progress(1, 2, "rows")


def test_a_bar_moves_when_it_is_time_or_at_the_end_of_a_phase(monkeypatch):
    now, shown = SimpleNamespace(s=100.0), []

    class Bar:
        def __init__(self, console, *, transient, auto_refresh):
            assert (transient, auto_refresh) == (True, False)

        def __enter__(self):
            return self

        def __exit__(self, *error):
            pass

        def add_task(self, what, total):
            assert (what, total) == ("reading", None)
            return "task"

        def update(self, task, **state):
            self.state = task, *state.values()

        def refresh(self):
            shown.append((now.s, self.state))

    monkeypatch.setattr("rich.progress.Progress", Bar)
    monkeypatch.setattr(frame, "_BAR_S", 0.25)
    monkeypatch.setattr(frame, "time", SimpleNamespace(monotonic=lambda: now.s))
    monkeypatch.setattr(sys, "stderr", SimpleNamespace(isatty=lambda: True))
    with frame.progress_bar() as progress:
        for now.s, done in ((100.0, 0), (100.125, 1), (100.25, 2), (100.375, 3), (100.4375, 9)):
            progress(done, 9, "rows")
    assert shown == [(at, ("task", done, 9, "rows")) for at, done in ((100.0, 0), (100.25, 2), (100.4375, 9))]


# ------------------------------------------------------------------------------------------------- parts of the frame
@pytest.mark.parametrize("printed", [0, frame.UNMET, frame.UNREAD, frame.REFUSED, frame.INTERRUPTED])
def test_what_is_left_to_do_is_done_unless_the_printing_was_interrupted(monkeypatch, printed):
    said = []

    def print_it(text, code):
        said.append((text, code))
        return printed

    @frame.command
    def body():
        return frame.Outcome("verdict", 1, afterwards=lambda: "written")

    monkeypatch.setattr(frame, "_printed", print_it)
    with pytest.raises(typer.Exit) as stop:
        body()
    assert stop.value.exit_code == printed
    assert said == [("verdict", 1), *([("written", printed)] if printed != frame.INTERRUPTED else [])]


@pytest.mark.parametrize(("met", "closes"), [(True, False), (False, True), (True, True), (False, False)])
def test_the_exit_code_says_what_it_was_asked_to_judge(met, closes):
    assert frame.Judged.REQUIREMENTS.code(met=met, closes=closes) == (0 if met else 1)
    assert frame.Judged.CLOSES.code(met=met, closes=closes) == (0 if closes else 1)


def test_what_is_no_finite_number_is_null_wherever_it_stands():
    data = {"a": [1.5, math.nan, (math.inf, -math.inf)], "b": {"c": math.nan, "d": True}, "e": "nan", "f": 3, "g": None}
    found = {"a": [1.5, None, [None, None]], "b": {"c": None, "d": True}, "e": "nan", "f": 3, "g": None}
    assert json.loads(frame.json_text(data)) == found


def test_a_line_of_progress_is_said_in_every_interval_and_none_in_the_first(monkeypatch, capsys):
    now = SimpleNamespace(s=100.0)
    monkeypatch.setattr(frame, "time", SimpleNamespace(monotonic=lambda: now.s))
    progress = frame._progress_lines(10.0)
    for second in (100.0, 109.9, 110.0, 119.9, 120.0, 121.0):
        now.s = second
        progress(int(second), 200, "rows")
    assert capsys.readouterr().err.splitlines() == ["microrad: 110 of 200: rows", "microrad: 120 of 200: rows"]


def test_a_record_of_progress_is_left_out_only_within_a_phase_and_never_the_last(monkeypatch, tmp_path):
    now = SimpleNamespace(s=100.0)
    monkeypatch.setattr(frame, "time", SimpleNamespace(monotonic=lambda: now.s, time=lambda: now.s + 0.00049))
    steps = [
        (100.0, 0, 9, "a", True),
        (100.1, 1, 9, "a", False),
        (100.24, 2, 9, "a", False),
        (100.26, 2, 9, "a", True),
        (100.3, 3, 9, "b", True),
        (100.31, 3, 8, "b", True),
        (100.32, 4, 8, "b", False),
        (100.33, 8, 8, "b", True),
        (101.0, 1, 8, "b", True),
        (101.25, 2, 8, "b", True),
    ]
    monkeypatch.setattr(frame, "_PROGRESS_S", 0.25)
    with (tmp_path / "progress").open("ab", buffering=0) as file:
        progress = frame._progress_records(file)
        for now.s, done, total, what, _ in steps:
            progress(done, total, what)
    found = [json.loads(line) for line in (tmp_path / "progress").read_text().splitlines()]
    assert found == [
        {"at": round(at_s, 3), "done": done, "total": total, "what": what}
        for at_s, done, total, what, kept in steps
        if kept
    ]


@pytest.mark.parametrize(("size", "begins_anew"), [(frame._PROGRESS_BYTES, False), (frame._PROGRESS_BYTES + 1, True)])
def test_a_long_file_of_progress_begins_anew(tmp_path, size, begins_anew):
    path = tmp_path / "progress"
    path.write_bytes(b"\n" * size)
    with path.open("ab", buffering=0) as file:
        frame._progress_records(file)(1, 2, "rows")
    assert (path.stat().st_size < size) is begins_anew
    assert json.loads(path.read_text().strip())["done"] == 1


@pytest.mark.parametrize(
    ("error", "code", "said"),
    [
        (KeyboardInterrupt(), 130, "interrupted, nothing was written"),
        (KeyboardInterrupt("stopped at row 3"), 130, "stopped at row 3"),
        (
            OSError(errno.ENOSPC, "No space left", "out.csv"),
            2,
            "out.csv: No space left; nothing was written there. Check",
        ),
        (OSError("gone"), 2, "microrad: gone; nothing was written. Check free space"),
        (frame.Refusal("give a file"), 2, "microrad: give a file\n"),
        (MemoryError(), 2, "not enough memory"),
        (MemoryError("too many rows"), 2, "too many rows"),
        (ValueError("of a library"), 70, "a fault of microrad or of its installation"),
        (TypeError("no"), 70, "a fault of microrad or of its installation"),
    ],
)
def test_each_kind_of_failure_has_its_exit_code_and_its_words(capsys, error, code, said):
    assert frame._failed(error) == code
    err = capsys.readouterr().err
    assert said in err and err.startswith("microrad: " if code != frame.BUG else f"{type(error).__name__}: ")


def test_an_error_of_ours_is_an_answer_where_it_is_a_value_error_and_an_interrupted_import_is_none(capsys):
    of_microrad = {"__module__": "microrad.somewhere"}
    answer, fault = (type("Odd", (kind,), of_microrad)("not so") for kind in (ValueError, RuntimeError))
    assert (frame._failed(answer), frame._failed(fault)) == (frame.REFUSED, frame.BUG)
    capsys.readouterr()
    broken = ImportError("half a module")
    broken.__cause__ = KeyboardInterrupt()
    assert frame._failed(broken) == frame.INTERRUPTED
    assert capsys.readouterr().err == "microrad: interrupted, nothing was written\n"


def test_an_error_behind_which_an_interrupt_stands_is_one():
    for link in ("__cause__", "__context__"):
        first, second = ValueError(), ImportError()
        setattr(first, link, second)
        assert not frame.interrupted(first)
        setattr(second, link, KeyboardInterrupt())
        assert frame.interrupted(first)
    assert not frame.interrupted(None)


@pytest.mark.parametrize(("columns", "width"), [("60", 80), ("80", 80), ("133", 133)])
def test_tables_are_as_wide_as_the_terminal_and_at_least_eighty_columns(monkeypatch, columns, width):
    monkeypatch.setenv("COLUMNS", columns)
    assert frame.width() == width


def made_up(inputs, outputs):
    return SimpleNamespace(drive=np.zeros((2, inputs)), output=np.zeros((2, outputs)))


@pytest.mark.parametrize(("inputs", "outputs", "several"), [(1, 1, False), (2, 1, True), (1, 2, True)])
@pytest.mark.parametrize("validation", [False, True])
def test_recordings_have_several_channels_where_any_has(inputs, outputs, several, validation):
    plain, other = made_up(1, 1), made_up(inputs, outputs)
    given = recordings.Given((plain,), (other,)) if validation else recordings.Given((plain, other), ())
    assert (given.channels, given.several_channels) == ((inputs, outputs), several)
    assert given.every == (plain, other)


@pytest.mark.parametrize("places", [None, 1, 2, 3])
def test_there_is_a_position_for_each_output_or_none(monkeypatch, places):
    from microrad.lab import recording

    together = []
    monkeypatch.setattr(recording, "check_together", lambda *parts: together.append(parts))
    positions = None if places is None else ((0.0, 0.0),) * places
    given = recordings.Given((made_up(1, 2),), (), positions_m=positions)
    if places in (None, 2):
        assert recordings._together(given) is given
    else:
        with pytest.raises(frame.Refusal, match=f"--position is given {places} times and there are 2 outputs"):
            recordings._together(given)
    assert together == [(given.recordings, ())]
    alone = recordings.Given((made_up(1, 1),), ())
    assert recordings._together(alone) is alone and len(together) == 1
    with pytest.raises(frame.Refusal, match="every recording is for validation: leave one to be fitted"):
        recordings._together(recordings.Given((), (made_up(1, 1),)))


@pytest.mark.parametrize(
    ("model", "static", "fitted"),
    [
        (lab.Model.BEST, True, ("prandtl_ishlinskii", "bouc_wen")),
        (lab.Model.BOUC_WEN, True, ("prandtl_ishlinskii", "bouc_wen")),
        (lab.Model.BOUC_WEN_CREEP, True, ("prandtl_ishlinskii", "bouc_wen", "bouc_wen_creep")),
        (lab.Model.BEST, False, identify.MODELS),
        (lab.Model.LINEAR, False, identify.MODELS),
    ],
)
def test_the_model_that_is_asked_for_is_fitted_beside_those_of_the_ladder(
    refused, folder, monkeypatch, model, static, fitted
):
    asked = []

    def fit(recordings, hold_out, seed, models, bar, **options):
        asked.append((len(recordings), hold_out, seed, models))
        raise identify.IdentificationError("asked")

    monkeypatch.setattr("microrad.lab.identify.identify", fit)
    columns = COLUMNS if static else COLUMNS[:-1]
    path = write_recording(folder / "loop.csv")
    refused("identify", path, *columns, "--model", model.value, "--seed", "3", "--hold-out", "0.25")
    assert asked == [(1, 0.25, 3, fitted)]


@pytest.mark.parametrize(
    ("model", "admissible", "written"),
    [
        (lab.Model.BEST, False, "linear"),
        (lab.Model.BEST, True, "linear"),
        (lab.Model.BOUC_WEN, False, "bouc_wen"),
        (lab.Model.BOUC_WEN, True, "bouc_wen_admissible"),
        (lab.Model.BOUC_WEN_CREEP, True, "bouc_wen_creep"),
    ],
)
def test_the_mirror_file_has_the_model_that_is_asked_for_or_the_chosen_one(model, admissible, written):
    assert lab._written(SimpleNamespace(chosen="linear"), model, admissible) == written
    best = lab._written(SimpleNamespace(chosen="bouc_wen"), lab.Model.BEST, admissible)
    assert best == ("bouc_wen_admissible" if admissible else "bouc_wen")


@pytest.mark.parametrize(
    ("name", "listed", "title"),
    [(None, None, "l" * 200), (None, "of the list", "of the list"), ("mine", "of the list", "mine")],
)
def test_a_mirror_is_called_as_is_said_or_as_its_list_or_its_files(refused, folder, monkeypatch, name, listed, title):
    def identified(given, units, said, target, how, as_json):
        raise frame.Refusal(f"{given.name}|{units}|{target.title}|{target.mirror_file}|{target.page}")

    given = recordings.Given((made_up(1, 1),), (), name=listed)
    monkeypatch.setattr(lab, "given_recordings", lambda options: given)
    monkeypatch.setattr(lab, "unit_of", lambda given, which, said, assumed: (assumed, "assumed"))
    monkeypatch.setattr(lab, "_identify_axis", identified)
    file = "l" * 201
    said = refused("identify", f"{file}.csv", *(() if name is None else ("--name", name)))
    units = "('V', 'mrad')"
    assert said == f"microrad: {listed}|{units}|{title}|{file}-mirror.toml|{file}-mirror.html\n"
    said = refused("identify", "a.csv", "--mirror-file", "lab.toml", "--output", "x")
    assert said.endswith("|lab.toml|lab.html\n")


@pytest.mark.parametrize(("columns", "taken"), [((), (None, None)), (("u",), ("u", None)), (("u", "y"), ("u", "y"))])
def test_whole_arrays_have_one_drive_and_one_output_at_most(monkeypatch, columns, taken):
    read = []
    monkeypatch.setattr("microrad.lab.recording.read_arrays", lambda *args, **options: read.append((args, options)))
    options = recordings.Options((), columns[:1], columns[1:], axes="samples , channels", rate=5.0, accept=("drift",))
    recordings._reader(options)("u.npy", "y.npy")
    told = {"axes": ["samples", "channels"], "output_path": "y.npy", "accept": ("drift",), "alone": False}
    assert read == [(("u.npy", *taken, 5.0), {**told, "period_samples": None})]


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"input": ("a", "b")}, "leave out a second --input or --output"),
        ({"output": ("a", "b")}, "leave out a second --input or --output"),
        ({"time": "t", "input": ("a", "b")}, "leave out --time"),
    ],
)
def test_whole_arrays_refuse_a_second_column_of_either_kind(options, words):
    with pytest.raises(frame.Refusal, match=words):
        recordings._reader(recordings.Options((), axes="samples", **options))


@pytest.mark.parametrize(
    ("said", "words"),
    [
        ({}, "--input is missing: name the column of the drive"),
        ({"input": ("u",)}, "--output is missing: name the column of the sensor"),
        ({"output_file": (Path("y"),)}, "--output-file is for whole arrays"),
    ],
)
def test_columns_of_tables_are_named(said, words):
    with pytest.raises(frame.Refusal, match=words):
        recordings._reader(recordings.Options((), **said))


def test_a_folder_of_the_bench_keeps_what_is_said_of_the_mirror(monkeypatch, tmp_path):
    both = [(made_up(1, 1), "identification"), (made_up(1, 2), "validation")]
    accepted = []
    monkeypatch.setattr("microrad.lab.bench.read_folder", lambda path, accept: accepted.append(accept) or both)
    monkeypatch.setattr("microrad.lab.recording.check_together", lambda *parts: None)
    places = ((0.0, 1.0), (2.0, 3.0))
    options = recordings.Options((tmp_path,), lever_arm=0.05, position=places, accept=("drift",))
    found = recordings.given_recordings(options)
    assert (found.recordings, found.validation) == ((both[0][0],), (both[1][0],))
    assert (found.virtual, found.lever_arm_m, found.positions_m, accepted) == (True, 0.05, places, [("drift",)])
    assert recordings.given_recordings(recordings.Options((tmp_path,))).positions_m is None


# --------------------------------------------------------------------------------------- several files, options at once
def test_files_of_drives_and_of_outputs_are_read_in_pairs_and_those_for_validation_come_last(monkeypatch):
    read = []

    def arrays(*given, **options):
        read.append((given, options["output_path"], options["period_samples"], options["accept"]))
        return tuple(made_up(1, 1) for _ in range(len(read)))

    monkeypatch.setattr("microrad.lab.recording.read_arrays", arrays)
    options = recordings.Options(
        (Path("u1"), Path("u2")),
        ("u",),
        ("y",),
        (Path("y1"), Path("y2"), Path("y3")),
        axes="samples,periods",
        rate=625.5,
        period=12,
        accept=("drift", "clipping"),
        validate=(Path("u3"),),
        lever_arm=0.0375,
    )
    found = recordings.given_recordings(options)
    more = "u", "y", 625.5
    assert read == [((Path(f"u{n}"), *more), Path(f"y{n}"), 12, ("drift", "clipping")) for n in (1, 2, 3)]
    assert (len(found.recordings), len(found.validation), found.lever_arm_m) == (3, 3, 0.0375)
    assert (found.virtual, found.name, found.positions_m, found.signs) == (False, None, None, None)
    with pytest.raises(frame.Refusal) as refusal:
        recordings.given_recordings(replace(options, output_file=options.output_file[:2]))
    assert str(refusal.value) == (
        "--output-file is given 2 times and there are 3 files of drives; give one for each FILE, and then for each "
        "--validate, in their order."
    )


def test_columns_of_tables_are_read_with_all_that_is_said_of_them(monkeypatch):
    read = []
    monkeypatch.setattr(
        "microrad.lab.recording.read_recording", lambda *given, **more: read.append((given, more)) or made_up(1, 1)
    )
    options = recordings.Options(
        (Path("a"), Path("b")),
        ("u", "v"),
        ("y",),
        rate=7.5,
        time="t",
        period=9,
        accept=("drift",),
        validate=(Path("c"),),
    )
    found = recordings.given_recordings(options)
    more = {"time": "t", "period_samples": 9, "accept": ("drift",), "alone": False}
    assert read == [((Path(name), ("u", "v"), ("y",), 7.5), more) for name in "abc"]
    assert (len(found.recordings), len(found.validation)) == (2, 1)


@pytest.mark.parametrize("place", ["files", "validate"])
def test_a_list_among_other_files_is_named(place):
    given = {"files": (Path("a.csv"),), "validate": (), place: (Path("b.csv"), Path("l.toml"), Path("m.toml"))}
    with pytest.raises(frame.Refusal) as refusal:
        recordings.given_recordings(recordings.Options(**given))
    assert str(refusal.value) == "l.toml is a list of recordings: give it alone, and name the other files in it."


@pytest.mark.parametrize(
    ("option", "value", "flag"),
    [
        ("output", ("y",), "--output"),
        ("axes", "samples", "--axes"),
        ("time", "t", "--time"),
        ("period", 5, "--period"),
        ("accept", ("drift",), "--accept"),
        ("validate", (Path("v.csv"),), "--validate"),
        ("position", ((0.0, 0.0),), "--position"),
        ("lever_arm", 0.0, "--lever-arm"),
    ],
)
def test_each_option_for_files_is_refused_beside_a_list(option, value, flag):
    with pytest.raises(frame.Refusal) as refusal:
        recordings.given_recordings(recordings.Options((Path("l.toml"),), **{option: value}))
    words = f"l.toml is a list of recordings and {flag} is for files: write it into the list instead."
    assert str(refusal.value) == words


@pytest.mark.parametrize(
    ("option", "value", "flag"),
    [
        ("input", ("u",), "--input"),
        ("output", ("y",), "--output"),
        ("output_file", (Path("y.csv"),), "--output-file"),
        ("axes", "samples", "--axes"),
        ("rate", 5.0, "--rate"),
        ("time", "t", "--time"),
        ("period", 5, "--period"),
        ("validate", (Path("v.csv"),), "--validate"),
    ],
)
def test_each_option_for_files_is_refused_beside_a_folder(tmp_path, option, value, flag):
    with pytest.raises(frame.Refusal) as refusal:
        recordings.given_recordings(recordings.Options((tmp_path,), **{option: value}))
    words = f"{tmp_path} is a folder, as of a bench, and {flag} is for files: leave it out, or name the files."
    assert str(refusal.value) == words


def named(path, units, names=("u", "y")):
    return SimpleNamespace(path=path, input_names=names[:1], output_names=names[1:], **units)


@pytest.mark.parametrize(
    ("which", "option", "found"),
    [
        ("input", None, ("mV", "stated in the files")),
        ("output", None, ("mrad", "assumed, --output-unit says otherwise")),
        ("input", "mV", ("mV", "given")),
        ("output", "um", ("um", "given")),
    ],
)
def test_the_unit_of_a_channel_is_given_stated_or_assumed(which, option, found):
    first = named("a.csv", {"input_units": ("",), "output_units": ("",)})
    second = named("b.csv", {"input_units": ("mV",), "output_units": ("",)})
    given = recordings.Given((first,), (second,))
    assert recordings.unit_of(given, which, option, "V" if which == "input" else "mrad") == found


def test_units_that_recordings_say_otherwise_are_told_with_their_files():
    given = recordings.Given(
        (
            named("a.csv", {"input_units": ("V",), "output_units": ("urad",)}),
            named("b.csv", {"input_units": ("V",), "output_units": ("mrad",)}),
        ),
        (named("c.csv", {"input_units": ("V",), "output_units": ("urad",)}),),
    )
    with pytest.raises(frame.Refusal) as refusal:
        recordings.unit_of(given, "output", None, "mrad")
    assert str(refusal.value) == (
        "the files say different units of the output, urad (a.csv), mrad (b.csv): identify them apart, or convert them."
    )
    with pytest.raises(frame.Refusal) as refusal:
        recordings.unit_of(given, "output", "urad", "mrad")
    assert str(refusal.value) == (
        "--output-unit is urad and the files say mrad, urad: give what the files say, or neither."
    )
    assert recordings.unit_of(given, "input", None, "V") == ("V", "stated in the files")


@pytest.mark.parametrize(
    ("text", "place"), [("12 mm,-6.5 mm", (0.012, -0.0065)), (" 1 um , 2 m ", (1e-6, 2.0)), ("0 m,0 m", (0.0, 0.0))]
)
def test_a_place_has_its_first_length_across(text, place):
    assert lab._place(text) == pytest.approx(place, rel=1e-12)


@pytest.mark.parametrize("text", ["12 mm", "1 mm,2 mm,3 mm", ""])
def test_what_is_no_place_is_refused_as_it_was_typed(text):
    with pytest.raises(typer.BadParameter) as refusal:
        lab._place(text)
    assert str(refusal.value) == f"'{text}' is no place; give x and y as '12 mm,-6 mm'."


@pytest.mark.parametrize(
    ("given", "folder_name", "seed", "overwrite"),
    [
        ((), "my plan-bench", 0, False),
        (("--output", "a b/c", "--seed", "17", "--overwrite"), "a b/c", 17, True),
    ],
)
def test_a_plan_is_played_into_the_folder_that_is_named(call, folder, monkeypatch, given, folder_name, seed, overwrite):
    asked = []
    monkeypatch.setattr("microrad.lab.bench.load_plan", lambda plan: SimpleNamespace(name=f"plan of {plan}"))
    monkeypatch.setattr("microrad.lab.bench.check_folder", lambda *given: asked.append(given))

    def write(found, *more):
        asked.append(more[:3])
        return [more[0] / name for name in ("x.csv", "y.csv", "plan.toml")]

    monkeypatch.setattr("microrad.lab.bench.write_folder", write)
    result = call("bench", "sub/my plan.toml", *given)
    files = "\n".join(f"{folder_name}/{name}" for name in ("x.csv", "y.csv", "plan.toml"))
    named = shlex.quote(folder_name)
    assert result.out == f"{files}\n\n3 files written. Next: microrad identify {named}\n"
    assert asked == [(Path(folder_name), overwrite), (Path(folder_name), seed, overwrite)]
    data = json.loads(call("bench", "sub/my plan.toml", *given, "--json").out)
    assert (data["plan"], data["folder"], data["files"]) == (
        "plan of sub/my plan.toml",
        folder_name,
        files.splitlines(),
    )


@pytest.mark.parametrize(
    ("options", "passed"),
    [
        ((), ("zero-order", False, "mrad", "V", None)),
        (("--measured-drive", "--admissible"), ("first-order", True, "mrad", "V", None)),
        (
            ("--output-unit", "um", "--lever-arm", "37.5 mm", "--input-unit", "mV"),
            ("zero-order", False, "um", "mV", 0.0375),
        ),
    ],
)
def test_what_is_said_of_drive_output_and_models_is_handed_on(refused, folder, monkeypatch, options, passed):
    asked = []

    def fit(recordings, hold_out, seed, models, bar, **more):
        asked.append([more[key] for key in ("hold", "admissible", "output_unit", "input_unit", "lever_arm_m")])
        asked.append((len(recordings), len(more["validation"]), hold_out, seed, more["side_by_side"]))
        raise identify.IdentificationError("asked")

    monkeypatch.setattr("microrad.lab.identify.identify", fit)
    fitted, checked = write_recording(folder / "loop.csv"), write_recording(folder / "other.csv", reverse=True)
    refused("identify", fitted, *COLUMNS, "--validate", checked, *options)
    assert asked == [[*passed], (1, 1, None, 0, True)]


@pytest.mark.parametrize(
    ("checks", "width", "lines"),
    [
        (
            [installation.Check("a", True, "found it"), installation.Check("b c", False, "gone", "do this, then that")],
            41,
            ["ok       a                 found it", "problem  b c               gone; do this,", " " * 9 + "then that"],
        ),
        (
            [installation.Check("kernel cache", True, "x" * 30)],
            20,
            ["ok       kernel", " " * 9 + "cache", " " * 9 + "x" * 30],
        ),
    ],
)
def test_a_check_has_a_line_that_goes_on_set_in(checks, width, lines):
    assert installation.text(checks, width).split("\n") == lines


@pytest.mark.parametrize(
    ("other", "source", "ok", "found", "advice"),
    [
        (None, True, True, "not compared: nothing says which versions were tested", ""),
        ({}, True, True, "those of constraints.txt", ""),
        ({"a==1": "a 2", "b==3": "b 4"}, False, True, "not all of those that were tested: a 2, b 4", ""),
        (
            {"a==1": "a 2", "b==3": "b 4"},
            True,
            False,
            "not those of constraints.txt: a 2, b 4",
            "in the project's folder: python -m pip install --constraint constraints.txt a==1 b==3",
        ),
    ],
)
def test_libraries_of_other_versions_are_told_apart_from_those_that_were_chosen(
    monkeypatch, other, source, ok, found, advice
):
    monkeypatch.setattr(installation, "other_versions", lambda: other)
    monkeypatch.setattr(installation, "from_source", lambda: source)
    assert installation._pins() == installation.Check("pinned versions", ok, found, advice)


def test_what_a_check_raises_is_told_by_its_first_line():
    def broken():
        raise RuntimeError("one\ntwo")

    def silent():
        raise OSError

    assert installation._check("a", broken, "do") == installation.Check("a", False, "RuntimeError: one", "do")
    assert installation._check("b", silent, "do") == installation.Check("b", False, "OSError: ", "do")
    assert installation._check("c", lambda: (True, "x"), "do") == installation.Check("c", True, "x", "")


@pytest.mark.parametrize(
    ("make", "given", "words"),
    [
        (lambda path: None, {}, "{path}: there is no folder {parent}; create it first."),
        (lambda path: path.write_text("# Mine"), {}, "{path} exists and is left as it is; do this."),
        (
            lambda path: path.write_text("# Mine"),
            {"begins": b"# Mine"},
            "{path} exists and is left as it is; do this, or replace it with --overwrite.",
        ),
        (
            lambda path: path.write_text("# Other"),
            {"begins": b"# Mine", "overwrite": True},
            "{path} was not written by microrad and is left as it is; do this.",
        ),
        (
            lambda path: path.symlink_to("nowhere"),
            {"begins": b"# Mine"},
            "{path} exists and is left as it is; do this, or replace it with --overwrite.",
        ),
        (lambda path: path.write_text(""), {"overwrite": True}, "{path} exists and is left as it is; do this."),
    ],
)
def test_a_file_that_must_not_be_written_says_what_to_do(tmp_path, make, given, words):
    path = tmp_path / ("none/x" if "there is no folder" in words else "x")
    make(path)
    with pytest.raises(frame.Refusal) as refusal:
        frame.check_target(path, "do this", **given)
    assert str(refusal.value) == words.format(path=path, parent=path.parent)


def test_a_refusal_names_the_file_that_it_is_of_and_the_page_that_says_more(capsys):
    with pytest.raises(frame.Refusal, match=r"^m\.toml: no$"), frame.refusal_of(Path("m.toml")):
        raise ValueError("no")
    refusal, cause = frame.Refusal("not so"), ValueError()
    cause.page = "bench"
    refusal.__cause__ = cause
    assert frame._failed(refusal) == frame.REFUSED
    refusal.page = "link"
    assert frame._failed(refusal) == frame.REFUSED
    assert capsys.readouterr().err == ("microrad: not so (see docs/bench.md)\nmicrorad: not so (see docs/link.md)\n")


def test_a_mission_is_written_with_the_command_that_goes_on_with_it(call, folder):
    result = call("init", "my mission.toml")
    assert result.out == "my mission.toml written. Next: microrad run 'my mission.toml'\n"
    assert (folder / "my mission.toml").read_text("utf-8") == PAPER.read_text("utf-8")
    again = call("init", "my mission.toml")
    assert again.err == (
        "microrad: my mission.toml exists and is left as it is; name another one (microrad init other.toml) or go on "
        "with `microrad run 'my mission.toml'`.\n"
    )
    assert again.code == 2


@pytest.mark.parametrize(("whole", "unknown"), [(True, ()), (False, ("a.b", "c.d"))])
def test_a_preset_says_what_is_to_be_given_first(call, folder, monkeypatch, whole, unknown):
    chosen = SimpleNamespace(name="mine", whole=whole, unknown=unknown)
    other = SimpleNamespace(name="other", whole=not whole, unknown=("x",))
    monkeypatch.setattr("microrad.mission.presets.preset_text", lambda name: f"# {name}")
    monkeypatch.setattr("microrad.mission.presets.presets", lambda: (other, chosen))
    first = "To be given first: a.b, c.d. " if unknown else ""
    command = "run" if whole else "budget"
    assert call("init", "--preset", "mine").out == f"mine.toml written. {first}Next: microrad {command} mine.toml\n"
    assert (folder / "mine.toml").read_text("utf-8") == "# mine"
    assert call("init", "--preset", "mine", "a b.toml").out.endswith(f"Next: microrad {command} 'a b.toml'\n")
    said = call("init", "--preset", "mine").err
    assert said == (
        "microrad: mine.toml exists and is left as it is; name another one: microrad init --preset mine other.toml.\n"
    )


# -------------------------------------------------------------------------------------------- handed on, one by one
@pytest.mark.parametrize(
    ("given", "mirror", "to", "flags", "code"),
    [
        ((), None, "my day-study", (False, False), 1),
        (("--mirror", "m.toml", "--overwrite", "--exit-on", "closes"), "m.toml", "my day-study", (True, False), 0),
        (("--output", "a/b", "--verbose", "--fresh"), None, "a/b", (False, True), 1),
    ],
)
def test_a_study_is_run_and_written_as_it_is_asked_for(call, folder, monkeypatch, given, mirror, to, flags, code):
    from microrad.core import kept

    overwrite, verbose = flags
    done, trouble = [], SimpleNamespace(trouble="no room for it")
    parts = kept.NOTHING if "--fresh" in given else trouble
    judged = SimpleNamespace(met=False, closes=True)
    monkeypatch.setenv("COLUMNS", "101")
    monkeypatch.setattr(kept, "of_user", lambda: trouble)
    monkeypatch.setattr(
        "microrad.mission.file.load_mission", lambda *given: done.append(given) or SimpleNamespace(path="there.toml")
    )
    monkeypatch.setattr(report, "check_folder", lambda *given: done.append(given))
    monkeypatch.setattr(
        study, "run_study", lambda mission, progress, parts: done.append((mission.path, parts)) or judged
    )
    monkeypatch.setattr(report, "verdict_text", lambda study, width, verbose: f"{study.met} {width} {verbose}")
    monkeypatch.setattr(report, "summary", lambda study: {"met": study.met, "folder": "?"})
    monkeypatch.setattr(
        report,
        "write",
        lambda study, folder, overwrite, on_progress, parts: done.append(
            (folder, overwrite, callable(on_progress), parts)
        ),
    )
    shown = call("run", "some/my day.toml", *given)
    steps = [(Path("some/my day.toml"), mirror and Path(mirror)), (Path(to), overwrite), ("there.toml", parts)]
    steps.append((Path(to), overwrite, True, parts))
    written = [f"{to}/{name}" for name in ("report.html", "results.nc", "manifest.json")]
    said = "" if "--fresh" in given else "microrad: no room for it\n"
    assert (shown.code, shown.err, done) == (code, said, steps)
    assert shown.out.splitlines() == [f"False 101 {verbose}", "", *written]
    shown = call("run", "some/my day.toml", *given, "--json")
    assert (shown.code, json.loads(shown.out), done[4:]) == (code, {"met": False, "folder": to}, steps)


@pytest.mark.parametrize("same", [True, False])
def test_a_report_that_differs_is_exit_1(call, monkeypatch, same):
    asked, found = [], SimpleNamespace(same=same)
    where = "microrad.report.results.reproduce"

    def reproduced(path, progress):
        for done in range(3):
            progress(done, 3, "step")
        asked.append((path, callable(progress)))
        return found

    monkeypatch.setattr(f"{where}.reproduce", reproduced)
    monkeypatch.setattr(f"{where}.reproduction_text", lambda found: f"in words: {found.same}")
    monkeypatch.setattr(f"{where}.reproduction_data", lambda found: {"same": found.same})
    assert call("reproduce", "a/report.html") == (int(not same), f"in words: {same}\n", "")
    shown = call("reproduce", "b", "--json")
    assert (shown.code, json.loads(shown.out)) == (int(not same), {"same": same})
    assert asked == [(Path("a/report.html"), True), (Path("b"), True)]


@pytest.mark.parametrize("good", [(True, True), (True, False), (False, True)])
def test_an_installation_with_a_problem_is_exit_1(call, monkeypatch, good):
    checks = [installation.Check(name, ok, f"{name} found", "do") for name, ok in zip("ab", good, strict=True)]
    monkeypatch.setenv("COLUMNS", "90")
    monkeypatch.setattr(installation, "run", lambda: checks)
    monkeypatch.setattr(installation, "text", lambda found, width: f"{len(found)} at {width}")
    assert call("doctor") == (int(not all(good)), "2 at 90\n", "")
    data = call("doctor", "--json")
    each = [{"name": c.name, "ok": c.ok, "found": c.found, "advice": "do"} for c in checks]
    assert (data.code, json.loads(data.out)) == (int(not all(good)), {"ok": all(good), "checks": each})


def test_an_explanation_is_as_wide_as_the_terminal_and_an_unknown_key_is_refused(call, refused, monkeypatch):
    from microrad.mission.explain import explained, text

    key, width = "fine_pointing", 131
    monkeypatch.setenv("COLUMNS", str(width))
    assert call("explain", key).out == f"{text(explained(key), width)}\n\n"
    with pytest.raises(ValueError, match="no-such") as refusal:
        explained("no-such")
    assert refused("explain", "no-such") == f"microrad: {refusal.value}\n"


@pytest.mark.parametrize(
    ("text", "unit", "value"),
    [
        ("50 kHz", "Hz", 5e4),
        ("37.5 mm", "m", 0.0375),
        ("-7 urad", "rad", -7e-6),
        ("3 Hz", "V", None),
        ("5", "Hz", None),
    ],
)
def test_a_quantity_of_an_option_is_that_of_its_unit_or_refused_in_the_words_of_units(text, unit, value):
    from microrad.core.units import UnitError, parse_quantity

    if value is not None:
        assert frame.quantity_of(unit)(text) == pytest.approx(value, rel=1e-12)
        return
    with pytest.raises(UnitError) as said:
        parse_quantity(text, unit)
    with pytest.raises(typer.BadParameter) as refusal:
        frame.quantity_of(unit)(text)
    assert str(refusal.value) == str(said.value)


@pytest.mark.parametrize(
    ("raised", "code", "said", "closed"),
    [
        (None, 7, "", 0),
        (BrokenPipeError(), frame.UNREAD, "", 1),
        (OSError(28, "No room"), frame.REFUSED, "microrad: the output cannot be written: No room\n", 1),
        (KeyboardInterrupt(), frame.INTERRUPTED, "microrad: interrupted while printing\n", 1),
    ],
)
def test_an_output_that_cannot_be_printed_is_told_by_its_reason(monkeypatch, capsys, raised, code, said, closed):
    count = []

    class Out:
        encoding = "utf-8"

        def write(self, text):
            if raised is not None:
                raise raised

        def flush(self):
            pass

    monkeypatch.setattr(frame, "_close_stdout", lambda: count.append(1))
    monkeypatch.setattr(sys, "stdout", Out())
    found = frame._printed("text", 7)
    assert (found, capsys.readouterr().err, len(count)) == (code, said, closed)


def test_a_process_that_is_left_has_said_what_it_had_to_say(monkeypatch):
    done = []

    def stream(name, error=None):
        def flush():
            done.append(name)
            if error:
                raise error

        return SimpleNamespace(flush=flush)

    monkeypatch.setattr(frame, "os", SimpleNamespace(_exit=done.append))
    for error in (None, ValueError("closed"), OSError(28, "full")):
        monkeypatch.setattr(frame, "sys", SimpleNamespace(stdout=stream("out", error), stderr=stream("err", error)))
        frame._leave(130)
    assert done == ["out", "err", 130] * 3


@pytest.mark.parametrize(("ended", "left"), [(130, True), (0, False), (1, False), (None, False)])
@pytest.mark.parametrize("ignored", [(), (signal.SIGHUP,), (signal.SIGHUP, signal.SIGTERM)])
def test_the_command_line_takes_what_ends_it_as_an_interrupt_unless_that_is_ignored(
    monkeypatch, capsys, ignored, ended, left
):
    done, first = [], []

    def run(prog_name):
        raise SystemExit(ended)

    taken = SimpleNamespace(
        SIGTERM=signal.SIGTERM,
        SIGHUP=signal.SIGHUP,
        SIG_IGN="ignored",
        default_int_handler="interrupt",
        getsignal=lambda number: "ignored" if number in ignored else "default",
        signal=lambda number, handler: done.append((number, handler)),
    )
    monkeypatch.setattr(frame, "signal", taken)
    monkeypatch.setattr(frame, "gc", SimpleNamespace(set_threshold=lambda *given: None))
    monkeypatch.setattr(frame, "compiling", SimpleNamespace(on_first=first.append))
    monkeypatch.setattr(frame, "app", run)
    monkeypatch.setattr(frame, "_leave", done.append)
    monkeypatch.setattr(sys, "unraisablehook", sys.unraisablehook)
    monkeypatch.delenv("OPENBLAS_NUM_THREADS", raising=False)
    with pytest.raises(SystemExit) as stop:
        frame.main()
    numbers = [number for number in (signal.SIGTERM, signal.SIGHUP) if number not in ignored]
    assert done == [*((number, "interrupt") for number in numbers), *[130] * left]
    assert (stop.value.code, sys.unraisablehook, os.environ["OPENBLAS_NUM_THREADS"]) == (
        ended,
        frame.interrupt_again,
        "1",
    )
    first[0]()
    words = "compiling the loops for this processor: once, for about half a minute"
    assert capsys.readouterr().err == f"microrad: {words}\n"


def test_what_is_refused_afterwards_is_said_behind_what_was_printed(capsys):
    def refuse():
        raise frame.Refusal("no room for the report")

    @frame.command
    def body(text, *, code):
        return frame.Outcome(text, code, afterwards=refuse)

    with pytest.raises(typer.Exit) as stop:
        body("verdict", code=0)
    shown = capsys.readouterr()
    assert (stop.value.exit_code, shown.out, shown.err) == (2, "verdict\n", "microrad: no room for the report\n")


def test_progress_is_said_where_it_can_be_seen(monkeypatch, tmp_path):
    monkeypatch.delenv(frame.PROGRESS_FILE, raising=False)
    monkeypatch.setattr(frame, "_progress_lines", lambda every_s: ("lines", every_s))
    monkeypatch.setattr(frame, "_progress_records", lambda file: ("records", file.write(b"new")))
    monkeypatch.setattr(sys, "stderr", SimpleNamespace(isatty=lambda: False))
    for given, every_s in (((), math.inf), ((12.5,), 12.5)):
        with frame.progress_bar(*given) as progress:
            assert progress == ("lines", every_s)
    (tmp_path / "progress").write_bytes(b"old ")
    monkeypatch.setenv(frame.PROGRESS_FILE, str(tmp_path / "progress"))
    with frame.progress_bar() as progress:
        assert progress == ("records", 3)
    assert (tmp_path / "progress").read_bytes() == b"old new"


def test_examples_stand_set_in_below_their_heading():
    assert frame.examples("microrad a", "microrad b  two") == "\b\nExamples:\n  microrad a\n  microrad b  two"
    made = frame.group("g", "what it does", "the end", add_completion=False).info
    assert (made.name, made.help, made.epilog, made.no_args_is_help) == ("g", "what it does", "the end", True)
    found = frame.option("--flag", "WORD", "its help", min=3)
    assert (found.default, found.metavar, found.help, found.min) == ("--flag", "WORD", "its help", 3)


@pytest.mark.parametrize(
    ("options", "hold", "written", "live"),
    [
        ((), "zero-order", "prandtl_ishlinskii", None),
        (("--model", "bouc-wen", "--admissible", "--json"), "zero-order", "bouc_wen_admissible", None),
        (("--measured-drive", "--name", "mine", "--overwrite"), "first-order", "prandtl_ishlinskii", "progress"),
    ],
)
def test_a_mirror_that_was_found_is_written_with_all_that_was_said_of_it(
    call, folder, monkeypatch, options, hold, written, live
):
    asked, recording = {}, write_recording(folder / "loop.csv")
    found = SimpleNamespace(chosen="prandtl_ishlinskii", unsupported="")
    if live:
        monkeypatch.setenv(frame.PROGRESS_FILE, str(folder / live))
    monkeypatch.setenv("COLUMNS", "99")
    monkeypatch.setattr("microrad.lab.live_fit.live_fit_writer", lambda path: f"fits beside {path}")
    monkeypatch.setattr(identify, "identify", lambda *given, **more: asked.update(fit=more) or found)
    monkeypatch.setattr(identify, "mirror_file_text", lambda found, title, model: f"# {title} {model}")
    monkeypatch.setattr(
        report,
        "identification_text",
        lambda found, model, width, mirror_file, report_file: f"{model} {width} {mirror_file} {report_file}",
    )
    monkeypatch.setattr(report, "identification_data", lambda found, model, **files: {"model": model} | said(files))
    monkeypatch.setattr(report, "write_identification", lambda *given, **more: asked.update(page=(given, more)))

    def said(files):
        return {name: str(path) for name, path in files.items()}

    shown = call("identify", recording, *COLUMNS, "--mirror-file", "m.v2.toml", *options)
    title = "mine" if "--name" in options else "loop"
    files = {"mirror_file": "m.v2.toml", "report_file": "m.v2.html"}
    if "--json" in options:
        assert json.loads(shown.out) == {"model": written, **files}
    else:
        units = (
            "drive in V (assumed, --input-unit says otherwise), output in mrad (assumed, --output-unit says otherwise)"
        )
        assert shown.out == f"{units}\n\n{written} 99 m.v2.toml m.v2.html\n"
    assert (shown.code, shown.err) == (0, "")
    fit = asked["fit"]
    assert (fit["on_fit"], fit["side_by_side"]) == (f"fits beside {folder / live if live else None}", not live)
    assert (fit["hold"], fit["admissible"]) == (hold, "--admissible" in options)
    (about, place), more = asked["page"]
    (read,) = more.pop("recordings")
    assert (about, place, read.samples, read.rate_hz) == (found, Path("m.v2.html"), 1500, 1000.0)
    text = f"# {title} {written}"
    assert more == {
        "mirror_file": Path("m.v2.toml"),
        "mirror_text": text,
        "title": title,
        "written": written,
        "overwrite": "--overwrite" in options,
        "virtual": False,
    }
    assert (folder / "m.v2.toml").read_text("utf-8") == text


@pytest.mark.parametrize(
    ("model", "fitted"),
    [
        ("bouc-wen-joint", ("a", "bouc_wen_joint")),
        ("bouc-wen", ("a", "bouc_wen")),
        ("best", ("a",)),
        ("linear", ("a", "linear")),
    ],
)
def test_a_model_is_fitted_once(model, fitted):
    assert lab._wanted(("a",), lab.Model(model)) == fitted
    assert lab._wanted(fitted, lab.Model(model)) == fitted


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"positions_m": ((0.0, 1.0),)}, "positions and signs are for several outputs or drives: leave out --position"),
        ({"signs": ((1.0,), (-1.0,))}, "positions and signs are for several outputs or drives: leave out --position"),
        ({"unsupported": "nothing holds"}, "nothing holds"),
    ],
)
def test_what_cannot_be_identified_of_one_axis_writes_nothing(refused, folder, monkeypatch, changes, words):
    recording = write_recording(folder / "loop.csv")
    read, unsupported = recordings.given_recordings, changes.pop("unsupported", "")
    monkeypatch.setattr(lab, "given_recordings", lambda options: replace(read(options), **changes))
    found = SimpleNamespace(unsupported=unsupported)
    monkeypatch.setattr(identify, "identify", lambda *given, **more: found if unsupported else pytest.fail("it ran"))
    assert refused("identify", recording, *COLUMNS).startswith(f"microrad: {words}")


@pytest.mark.parametrize(
    ("option", "flag"),
    [
        (("--measured-drive",), "--measured-drive"),
        (("--static",), "--static"),
        (("--model", "linear"), "--model"),
        (("--admissible",), "--admissible"),
        (("--seed", "1"), "--seed"),
        (("--hold-out", "0"), "--hold-out"),
        (("--lever-arm", "5 mm"), "--lever-arm"),
        (("--seed", "1", "--static"), "--static"),
    ],
)
def test_each_option_of_one_axis_is_refused_beside_several(refused, folder, monkeypatch, option, flag):
    given = SimpleNamespace(channels=(2, 3), name=None, several_channels=True, every=(), lever_arm_m=None)
    given.lever_arm_m = 0.005 if flag == "--lever-arm" else None
    monkeypatch.setattr(lab, "given_recordings", lambda options: given)
    monkeypatch.setattr(lab, "identify_channels", lambda *given: pytest.fail("it ran"))
    assert refused("identify", "a.csv", *option) == (
        f"microrad: {flag} is for one drive and one output, and these recordings have 2 and 3: leave it out, or name "
        "one of each (--input, --output).\n"
    )


def test_recordings_of_several_channels_are_identified_with_their_units_and_files(call, folder, monkeypatch):
    asked = []
    given = SimpleNamespace(channels=(2, 3), name="of the list", several_channels=True, every=(), lever_arm_m=None)
    monkeypatch.setattr(lab, "given_recordings", lambda options: given)
    monkeypatch.setattr(lab, "identify_channels", lambda *given: asked.append(given) or frame.Outcome("found", 130))
    options = ("--input-unit", "mV", "--output-unit", "um", "--report", "r.html", "--overwrite", "--json")
    assert call("identify", "sub/a.csv", *options) == (130, "found\n", "")
    ((read, units, said, target, as_json),) = asked
    assert (read, units, said, as_json) == (given, ("mV", "um"), "drive in mV (given), output in um (given)", True)
    files = target.mirror_file, target.page, target.title, target.overwrite
    assert files == (Path("a-mirror.toml"), Path("r.html"), "of the list", True)
    (folder / "a-mirror.toml").write_text("mine", "utf-8")
    with pytest.raises(frame.Refusal, match=r"a-mirror\.toml was not written by microrad .* --mirror-file\.$"):
        target.check()


@pytest.mark.parametrize(
    ("text", "begins"),
    [
        ("50 V", '"50 V" '),
        ("nan", '"nan Hz" does not begin with a plain number; expected a frequency with its unit'),
        ("1_000", '"1_000 Hz" '),
        ("fast", '"fast" does not begin with a plain number; expected a frequency with its unit'),
    ],
)
def test_what_is_no_rate_is_refused_in_the_words_of_a_frequency(text, begins):
    with pytest.raises(typer.BadParameter) as refusal:
        lab._rate(text)
    assert str(refusal.value).startswith(begins) and "a frequency with its unit" in str(refusal.value)


@pytest.mark.parametrize("several", [False, True])
@pytest.mark.parametrize("name", ["", " "])
def test_a_mirror_without_a_name_is_refused_before_anything_is_fitted(refused, folder, monkeypatch, name, several):
    channels = (2, 2) if several else (1, 1)
    given = SimpleNamespace(
        channels=channels, name=None, several_channels=several, every=(), positions_m=None, signs=None, lever_arm_m=None
    )
    monkeypatch.setattr(lab, "given_recordings", lambda options: given)
    for fits in ("_identify_axis", "identify_channels"):
        monkeypatch.setattr(lab, fits, lambda *given: pytest.fail("it is fitted"))
    assert "the mirror has no name; give one with --name" in refused("identify", "a.csv", "--name", name)


def test_a_name_that_begins_like_an_option_is_led_by_its_folder_in_the_next_command(call, refused, folder, monkeypatch):
    assert call("init", "--", "-x.toml").out == "-x.toml written. Next: microrad run ./-x.toml\n"
    assert "go on with `microrad run ./-x.toml`." in refused("init", "--", "-x.toml")
    assert "go on with `microrad run .`." in refused("init", ".")
    preset = call("init", "--preset", "tbird", "--", "-t.toml").out
    assert "Next: microrad" in preset and preset.endswith(" ./-t.toml\n")
    made = call("campaign", "init", "--", "-c.toml").out
    assert made.endswith("Next: microrad campaign run ./-c.toml\n")
    monkeypatch.setattr("microrad.lab.bench.load_plan", lambda plan: SimpleNamespace(name=plan))
    monkeypatch.setattr("microrad.lab.bench.write_folder", lambda *given: [])
    assert call("bench", "plan.toml", "--output=-b").out.endswith("Next: microrad identify ./-b\n")


# ------------------------------------------------------------------------------- what else a command line may say
@pytest.mark.parametrize(
    ("names", "called"),
    [
        ("60Hz.csv|80Hz.csv", "work"),
        ("a/loop-1.csv|b/loop-2.csv", "loop"),
        ("a/x.csv|b/y.csv", "x"),
        ("tip10.csv|tip1.csv", "tip"),
        ("mirror_a_1.csv|mirror_a_2.npy|mirror_b.csv", "mirror"),
        ("one.csv|deep/one.tdms", "one"),
        ("ab1.csv|ab2.csv", "work"),
        ("only.tar.gz", "only.tar"),
        ("scan 1.csv|scan 12.csv|scan.csv", "scan"),
    ],
)
def test_a_mirror_is_called_by_whole_words_that_all_files_begin_with(tmp_path, monkeypatch, names, called):
    (tmp_path / "work").mkdir()
    monkeypatch.chdir(tmp_path / "work")
    assert recordings.common_name(list(map(Path, names.split("|")))) == called


def of_units(*units):
    return recordings.Given(
        tuple(
            SimpleNamespace(
                path=f"r{k}", output_names=("y",), output_units=(unit,), input_names=("u",), input_units=("",)
            )
            for k, unit in enumerate(units)
        ),
        (),
    )


@pytest.mark.parametrize(
    ("units", "option", "found"),
    [
        (("um", "um"), None, ("um", "stated in the files")),
        (("um", ""), None, ("um", "stated in the files")),
        (("", ""), None, ("mrad", "assumed, --output-unit says otherwise")),
        (("", ""), "urad", ("urad", "given")),
        (("um",), "um", ("um", "given")),
        (("um",), "mm", "--output-unit is mm and the files say um: give what the files say, or neither."),
        (("um", "mm"), "um", "--output-unit is um and the files say mm, um: give what the files say, or neither."),
        (("um", "mm", "um"), None, "units of the output, um (r0), mm (r1): identify them apart, or convert them."),
    ],
)
def test_units_of_several_files_agree_or_are_refused(monkeypatch, units, option, found):
    monkeypatch.setattr("microrad.lab.recording.stated_units", lambda units, names: {unit for unit in units if unit})
    if isinstance(found, tuple):
        assert recordings.unit_of(of_units(*units), "output", option, "mrad") == found
        return
    with pytest.raises(frame.Refusal, match=re.escape(found)):
        recordings.unit_of(of_units(*units), "output", option, "mrad")


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"files": "a.csv b.toml"}, "b.toml is a list of recordings: give it alone, and name the other files in it."),
        ({"files": "a.csv", "validate": "v.toml"}, "v.toml is a list of recordings: give it alone"),
        ({"files": "a.npy b.npy", "axes": "samples", "output_file": "y.npy"}, "given 1 times and there are 2 files of"),
        ({"files": "a.npy", "validate": "v.npy", "axes": "samples", "output_file": "y.npy"}, "there are 2 files of dr"),
        ({"files": "a.csv", "output_file": "y.csv"}, "--output-file is for whole arrays: say with --axes what their a"),
        ({"files": "a.csv", "output": "y"}, "--input is missing: name the column of the drive."),
        ({"files": "a.csv", "input": "u"}, "--output is missing: name the column of the sensor."),
        ({"files": "a.csv"}, "--input is missing: name the column of the drive."),
        ({"files": "a.npy", "axes": "samples", "time": "t", "input": "u v"}, "one of outputs: leave out --time."),
        ({"files": "a.npy", "axes": "samples", "output": "y z"}, "leave out a second --input or --output."),
    ],
)
def test_recordings_that_the_options_do_not_say_are_refused_by_the_first_fault(given, words):
    said = {key: tuple(value.split()) if key not in {"axes", "time"} else value for key, value in given.items()}
    paths = {key: tuple(map(Path, said[key])) for key in ("files", "validate", "output_file") if key in said}
    with pytest.raises(frame.Refusal, match=re.escape(words)):
        recordings.given_recordings(recordings.Options(**{**said, **paths}))


@pytest.mark.parametrize(
    ("text", "begins"),
    [
        ("<!DOCTYPE html>\x1b", "<!DOCTYPE html>\x1b"),
        ("a\x1b[31mb", "a\\x1b[31mb"),
        ("tab\tline\nend", "tab\tline\nend"),
        ("", ""),
        ("é µ −", "é µ −"),
        ("< !\x07", "< !\\x07"),
    ],
)
def test_a_page_alone_is_printed_with_all_that_is_in_it(capsys, text, begins):
    assert frame._printed(text, 7) == 7
    assert capsys.readouterr().out.replace("\\u00", "\\x") == f"{begins}\n"


@pytest.mark.parametrize(
    ("error", "said"),
    [
        (OSError(13, "Permission denied", "a/b.csv"), "a/b.csv: Permission denied; nothing was written there. Check f"),
        (OSError(28, "No space left on device"), "microrad: No space left on device; nothing was written. Check free"),
        (BrokenPipeError(32, "Broken pipe", None), "microrad: Broken pipe; nothing was written. Check free space and"),
        (KeyboardInterrupt(), "microrad: interrupted, nothing was written\n"),
        (frame.Refusal("a\x1bb"), "microrad: a\\"),
    ],
)
def test_failures_are_told_in_one_line(capsys, error, said):
    code = frame._failed(error)
    err = capsys.readouterr().err
    assert said in err and err.count("\n") == 1
    assert code == (frame.INTERRUPTED if isinstance(error, KeyboardInterrupt) else frame.REFUSED)


@pytest.mark.parametrize(
    ("done", "written"),
    [
        (["a.toml"], "a.toml exists and is left as it is; ADVICE."),
        (["a.toml", "--begins"], "a.toml exists and is left as it is; ADVICE, or replace it with --overwrite."),
        (["a.toml", "--overwrite"], "a.toml exists and is left as it is; ADVICE."),
        (["b.toml", "--overwrite", "--begins"], "b.toml was not written by microrad and is left as it is; ADVICE."),
        (["d", "--overwrite", "--begins"], "d was not written by microrad and is left as it is; ADVICE."),
        (["e", "--begins"], "e exists and is left as it is; ADVICE, or replace it with --overwrite."),
        (["none/x.toml"], "none/x.toml: there is no folder none; create it first."),
        (["a.toml/x.toml"], "a.toml/x.toml: there is no folder a.toml; create it first."),
        (["a.toml", "--overwrite", "--begins"], ""),
        (["new.toml"], ""),
        (["empty", "--overwrite", "--begins"], ""),
    ],
)
def test_a_target_is_refused_with_what_may_be_done(folder, done, written):
    (folder / "a.toml").write_bytes(b"# Mine and more")
    (folder / "b.toml").write_bytes(b"# Min")
    (folder / "empty").touch()
    (folder / "d").mkdir()
    (folder / "e").symlink_to("nowhere")
    name, *flags = done
    given = {"overwrite": "--overwrite" in flags, "begins": b"# Mine" if "--begins" in flags else b""}
    if not written:
        frame.check_target(Path(name), "ADVICE", **given)
        return
    with pytest.raises(frame.Refusal) as caught:
        frame.check_target(Path(name), "ADVICE", **given)
    assert str(caught.value) == written


@pytest.mark.parametrize(
    ("version", "numbers"),
    [
        ("1.10.2", (1, 10, 2)),
        ("2.0rc1", (2, 0, 1)),
        ("1.2.3.4", (1, 2, 3)),
        ("9", (9,)),
        ("1.9.0+local7", (1, 9, 0)),
        ("", ()),
    ],
)
def test_a_version_has_its_first_three_numbers(version, numbers):
    assert installation._numbers(version) == numbers


@pytest.mark.parametrize(
    ("requires", "names"),
    [
        (["numpy>=1.26", "rich >= 13.0,<15", "pytest>=8; extra == 'dev'", "plain"], ["microrad", "numpy", "rich"]),
        ([], ["microrad"]),
        (None, ["microrad"]),
    ],
)
def test_libraries_without_a_floor_and_those_of_extras_are_not_looked_at(monkeypatch, requires, names):
    asked = []
    monkeypatch.setattr(installation.metadata, "requires", lambda name: requires)
    monkeypatch.setattr(installation, "_library", lambda name, lowest: asked.append((name, lowest)) or (False, "old"))
    found = list(installation._libraries())
    assert [check.name for check in found] == names and found[0].ok
    assert asked == [("numpy", "1.26"), ("rich", "13.0")][: len(names) - 1]
    assert [check.advice for check in found[1:]] == [
        f"python -m pip install '{name}>={lowest}'" for name, lowest in asked
    ]


def test_a_cache_that_cannot_be_written_is_a_problem_with_its_advice(monkeypatch, tmp_path):
    from microrad.core import kernels

    (tmp_path / "file").touch()
    closed_loop = SimpleNamespace(stats=SimpleNamespace(cache_path=str(tmp_path / "file" / "x")))
    monkeypatch.setattr(kernels, "closed_loop", closed_loop)
    found = installation._check("kernel cache", installation._cache, "ADVICE")
    assert (found.ok, found.advice) == (False, "ADVICE") and found.found.startswith("NotADirectoryError: ")
    monkeypatch.setattr(closed_loop.stats, "cache_path", str(tmp_path / "new" / "x"))
    assert installation._cache() == (True, f"{tmp_path / 'new' / 'x'} is writable")


@pytest.mark.parametrize(
    ("options", "told"),
    [
        (("--data-rate", "1 Gbit"), "--data-rate: "),
        (("--pointing-error", "5"), "--pointing-error: "),
        (("--pointing-error", "5 m", "--data-rate", "1 s"), "--data-rate: "),
    ],
)
def test_a_value_of_the_command_line_is_refused_under_its_option(options, told):
    from microrad.cli import link
    from microrad.mission.file import load_link

    given = dict(zip(options[::2], options[1::2], strict=True))
    with pytest.raises(frame.Refusal) as caught:
        link._changed(load_link(PAPER), given.get("--data-rate"), given.get("--pointing-error"))
    assert str(caught.value).startswith(told)


@pytest.mark.parametrize(
    ("rate", "error", "found"),
    [
        ("622.08 Mbit/s", None, (622.08e6, None)),
        (None, "4.5 urad", (None, 4.5e-6)),
        ("1.25 Gbit/s", "0 urad", (1.25e9, 0.0)),
        (None, None, (None, None)),
    ],
)
def test_values_of_the_command_line_stand_in_place_of_the_missions_with_their_source(rate, error, found):
    from microrad.cli import link
    from microrad.mission.file import load_link
    from microrad.mission.model import Source

    given = load_link(PAPER)
    changed = link._changed(given, rate, error)
    was, now = given.mission.communication, changed.mission.communication
    assert now.data_rate_bit_s == pytest.approx(was.data_rate_bit_s if found[0] is None else found[0])
    assert now.pointing_error_rad == pytest.approx(was.pointing_error_rad if found[1] is None else found[1])
    assert now.transmit_power_w == was.transmit_power_w
    for key, text in (("data_rate", rate), ("pointing_error", error)):
        source = changed.sources[f"communication.{key}"]
        said = given.sources[f"communication.{key}"] if text is None else Source(0, "command line", text)
        assert source == said
    assert given.sources is not changed.sources


def test_an_option_of_times_may_be_repeated_and_is_read_in_seconds():
    from microrad.cli.windows import time_option

    made = time_option("--window", "Length;")
    assert (made.help, made.metavar, made.show_default) == ("Length; may be repeated.", "TIME", False)
    assert made.parser("250 ms") == 0.25
    with pytest.raises(typer.BadParameter):
        made.parser("3 Hz")


@pytest.mark.parametrize(
    ("name", "several", "table", "of"),
    [
        ("LQG", None, None, "one"),
        ("PID", "both", None, "both"),
        ("PID", "both", SimpleNamespace(mirror_file=None), "both"),
        ("PID", "both", SimpleNamespace(mirror_file="m.toml"), "one"),
        ("PID + inverse", "both", SimpleNamespace(mirror_file="m.toml"), "one"),
        ("LQG", "both", SimpleNamespace(mirror_file="m.toml"), "both"),
    ],
)
def test_the_papers_controllers_are_of_the_missions_own_mirror_where_its_table_names_another(
    monkeypatch, name, several, table, of
):
    from microrad.cli import export
    from microrad.export import choice

    mission = SimpleNamespace(mission=SimpleNamespace(fine_pointing=table))
    monkeypatch.setattr(choice, "choose", lambda mission, name, progress: ("one", name, progress))
    monkeypatch.setattr(choice, "choose_coupled", lambda mission, several, name, progress: (several, name, progress))
    assert export._chosen(mission, several, name, "progress") == (of, name, "progress")


def test_a_group_of_commands_has_plain_help_and_its_examples():
    made = frame.group("g", "What it is.", frame.examples("one", "two"), hidden=True)
    assert (made.info.name, made.info.help, made.info.epilog, made.info.hidden) == (
        *("g", "What it is.", "\b\nExamples:\n  one\n  two", True),
    )
    assert made.info.no_args_is_help and made.pretty_exceptions_enable is False and made.rich_markup_mode is None


@pytest.mark.parametrize(
    ("exposed", "browser", "raised", "said"),
    [
        (None, False, None, ""),
        (None, True, None, ""),
        ("10.0.0.1", False, None, "microrad: open to the network on 10.0.0.1, and not encrypted: who reads the addres"),
        (None, True, OSError(28, "No space left"), "microrad: the browser was not opened (No space left); open the ad"),
    ],
)
def test_the_studio_says_where_it_is_and_opens_it_if_it_can(monkeypatch, capsys, exposed, browser, raised, said):
    import threading

    from microrad.cli import studio
    from microrad.studio import server

    opened = []

    def way_in(of, url):
        if raised:
            raise raised
        return f"{of} {url}"

    class Thread:
        def __init__(self, target, args, daemon):
            opened.append((target.__name__, args, daemon))

        def start(self):
            opened.append("started")

    monkeypatch.setattr(server, "way_in", way_in)
    monkeypatch.setattr(threading, "Thread", Thread)
    studio._ready(SimpleNamespace(studio="studio"), SimpleNamespace(url="http://x"), exposed, browser)
    out, err = capsys.readouterr()
    assert out == "http://x\n" and err.startswith(said) and bool(err) is bool(said)
    assert opened == ([("open", ("studio http://x",), True), "started"] if browser and not raised else [])


def test_different_units_of_one_file_are_told_in_order_with_the_first_file_of_each():
    given = recordings.Given(
        (
            named("a.csv", {"input_units": ("mV", "V"), "output_units": ("urad", "rad", "arcsec", "mrad")}),
            named("b.csv", {"input_units": ("", " V "), "output_units": ("um", "rad")}),
        ),
        (named("c.csv", {"input_units": ("V",), "output_units": ("deg", "um")}),),
    )
    for which, units in (
        ("output", "arcsec (a.csv), mrad (a.csv), rad (a.csv), urad (a.csv), um (b.csv), deg (c.csv)"),
        ("input", "V (a.csv), mV (a.csv)"),
    ):
        with pytest.raises(frame.Refusal) as refusal:
            recordings.unit_of(given, which, None, "mrad")
        assert str(refusal.value) == (
            f"the files say different units of the {which}, {units}: identify them apart, or convert them."
        )
    with pytest.raises(frame.Refusal) as refusal:
        recordings.unit_of(given, "input", "V", "V")
    assert str(refusal.value) == "--input-unit is V and the files say V, mV: give what the files say, or neither."


@pytest.mark.parametrize(("static", "live", "as_json"), [(True, None, False), (False, "told", True)])
def test_recordings_of_one_axis_are_fitted_and_reported_and_those_for_validation_are_beside_them(
    folder, monkeypatch, static, live, as_json
):
    steps = []
    given = recordings.Given(("first", "second"), ("unseen",), True, "listed", 0.05)
    target = lab.Target(Path("m.toml"), Path("p.html"), "the title", True, lambda: steps.append("checked"))
    how = lab._Fits(lab.Model.BOUC_WEN_CREEP, static, True, True, 0.0, 7)
    found = SimpleNamespace(chosen="linear", unsupported="")
    if live:
        monkeypatch.setenv(frame.PROGRESS_FILE, live)
    else:
        monkeypatch.delenv(frame.PROGRESS_FILE, raising=False)

    def fit(*args, **more):
        assert callable(args[4])
        steps.append((args[:4], more))
        return found

    def write(*args, **more):
        assert not (folder / "m.toml").exists()
        steps.append((args, more))

    monkeypatch.setattr("microrad.lab.live_fit.live_fit_writer", lambda path: f"fits beside {path}")
    monkeypatch.setattr(identify, "STATIC", ("pi", "bw", "more"))
    monkeypatch.setattr(identify, "MODELS", ("pi", "bw", "more", "linear"))
    monkeypatch.setattr(identify, "identify", fit)
    monkeypatch.setattr(identify, "mirror_file_text", lambda found, title, model: f"# {title} {model}")
    monkeypatch.setattr(report, "identification_text", lambda found, model, width, **files: f"{model} {[*files]}")
    monkeypatch.setattr(report, "identification_data", lambda found, model, **files: {"model": model})
    monkeypatch.setattr(report, "write_identification", write)
    outcome = lab._identify_axis(given, ("mV", "um"), "said", target, how, as_json)
    text = "said\n\nbouc_wen_creep ['mirror_file', 'report_file']"
    assert (outcome.code, outcome.text) == (0, '{\n  "model": "bouc_wen_creep"\n}' if as_json else text)
    models = ("pi", "bw", *(() if static else ("more", "linear")), "bouc_wen_creep")
    options = {
        "validation": ("unseen",),
        "admissible": True,
        "hold": "first-order",
        "output_unit": "um",
        "lever_arm_m": 0.05,
        "input_unit": "mV",
        "on_fit": f"fits beside {live}",
        "side_by_side": live is None,
    }
    page = {
        "mirror_file": Path("m.toml"),
        "mirror_text": "# the title bouc_wen_creep",
        "title": "the title",
        "written": "bouc_wen_creep",
        "recordings": ("first", "second"),
        "overwrite": True,
        "virtual": True,
    }
    first = ((("first", "second"), 0.0, 7, models), options)
    assert steps == [first, "checked", ((found, Path("p.html")), page)]
    assert (folder / "m.toml").read_text("utf-8") == page["mirror_text"]


@pytest.mark.parametrize(
    ("mirror", "page"),
    [("x.toml", "./x.toml"), ("sub/../x.toml", "x.toml"), ("x.html", None), ("sub/x.toml", "sub/x.toml")],
)
def test_a_mirror_file_and_a_report_are_two_files_however_they_are_spelled(refused, folder, monkeypatch, mirror, page):
    monkeypatch.setattr(lab, "given_recordings", lambda options: pytest.fail("it was read"))
    (folder / "sub").mkdir()
    said = refused("identify", "a.csv", "--mirror-file", mirror, *(() if page is None else ("--report", page)))
    shown = Path(page or mirror)
    assert said == (
        f"microrad: {shown} cannot be both the mirror file and the report; name another one with --report.\n"
    )


@pytest.mark.parametrize("options", [("--lever-arm", "0 m"), ()])
def test_a_lever_arm_of_nothing_is_one_that_was_given(refused, folder, monkeypatch, options):
    """A list may state one, too: only one that is not there at all is none."""
    given = recordings.Given((made_up(2, 2),), (), lever_arm_m=0.0)
    monkeypatch.setattr(lab, "given_recordings", lambda options: given)
    monkeypatch.setattr(lab, "unit_of", lambda *given: ("V", "given"))
    monkeypatch.setattr(lab, "identify_channels", lambda *given: pytest.fail("it ran"))
    assert refused("identify", "a.csv", *options).startswith("microrad: --lever-arm is for one drive and one output")


@pytest.mark.parametrize(
    ("key", "names"),
    [
        ("kind", ["orbit.leo.kind", "orbit.geo.kind"]),
        ("duration", ["orbit.duration", "fine_pointing.duration"]),
    ],
)
def test_each_of_several_keys_of_one_end_is_explained_in_the_data(call, key, names):
    from microrad.mission.explain import explained

    data = json.loads(call("explain", "--json", key).out)
    assert [each["name"] for each in data] == names
    assert data == json.loads(json.dumps([asdict(each) for each in explained(key)]))


READING = {
    "run": ("run", "{}"),
    "reproduce": ("reproduce", "{}"),
    "budget": ("budget", "{}"),
    "contacts": ("contacts", "{}"),
    "constellation": ("constellation", "{}"),
    "design": ("design", "{}"),
    "pointing": ("pointing", "{}"),
    "worst-case": ("worst-case", "{}"),
    "jitter": ("jitter", "{}", "a.csv"),
    "bench": ("bench", "{}"),
    "identify": ("identify", "{}", "--input", "0", "--output", "1"),
    "import": (
        *("import", "{}", "--travel", "2.5 mrad", "--drive", "0 V", "12 V", "--bias", "6 V"),
        *("--rate-limit", "3770 V/s", "--band", "1 Hz", "5 kHz", "--normalise-at", "2 Hz", "--output-unit", "mrad"),
    ),
    "export c": ("export", "c", "{}"),
    "export fmu": ("export", "fmu", "{}"),
    "export matrices": ("export", "matrices", "{}"),
    "campaign run": ("campaign", "run", "{}"),
    "campaign resume": ("campaign", "resume", "{}"),
    "campaign status": ("campaign", "status", "{}"),
    "campaign verify": ("campaign", "verify", "{}"),
    "campaign export": ("campaign", "export", "{}", "rows.csv"),
    "campaign report": ("campaign", "report", "{}", "p.html"),
    "campaign optimise": ("campaign", "optimise", "{}"),
}


def test_each_command_that_reads_a_file_is_among_those_below():
    def commands(group, begin=()):
        for name, each in group.commands.items():
            if hasattr(each, "commands"):
                yield from commands(each, (*begin, name))
            elif any(part.param_type_name == "argument" for part in each.params):
                yield " ".join((*begin, name))

    others = {"init", "campaign init", "explain", "studio"}  # which write a file, take a key, and open a page
    assert set(commands(typer.main.get_command(cli.app))) - others == set(READING)


@pytest.mark.parametrize("kind", ["missing", "binary", "empty"])
@pytest.mark.parametrize("command", READING)
def test_a_file_that_is_missing_or_none_of_its_kind_is_named_by_every_command(refused, folder, command, kind):
    name = "my file.csv" if command == "identify" else "my file.mat" if command == "import" else "my file.toml"
    if kind != "missing":
        (folder / name).write_bytes(b"" if kind == "empty" else bytes(range(256)) * 10)
    said = refused(*(part.format(name) for part in READING[command]))
    assert said.startswith("microrad: ") and name in said


@pytest.mark.parametrize("command", [each for each in READING if each not in ("identify", "reproduce")])
def test_a_folder_in_the_place_of_a_file_is_named_by_every_command_that_takes_none(refused, folder, command):
    (folder / "my folder.toml").mkdir()
    said = refused(*(part.format("my folder.toml") for part in READING[command]))
    assert said.startswith("microrad: ") and "my folder.toml" in said


WITH_MIRROR = {
    "run": ("run",),
    "design": ("design",),
    "worst-case": ("worst-case",),
    "export c": ("export", "c"),
    "export fmu": ("export", "fmu"),
    "export matrices": ("export", "matrices"),
}


def test_each_command_that_takes_a_mirror_file_is_among_those_below():
    def commands(group, begin=()):
        for name, each in group.commands.items():
            if hasattr(each, "commands"):
                yield from commands(each, (*begin, name))
            elif any("--mirror" in part.opts for part in each.params):
                yield " ".join((*begin, name))

    assert set(commands(typer.main.get_command(cli.app))) == set(WITH_MIRROR)


@pytest.mark.parametrize("kind", ["missing", "binary", "folder", "of nothing"])
@pytest.mark.parametrize("command", WITH_MIRROR)
def test_a_mirror_file_that_is_none_is_named_by_every_command_that_takes_one(refused, folder, command, kind):
    mirror = folder / "my mirror.toml"
    if kind == "folder":
        mirror.mkdir()
    elif kind != "missing":
        mirror.write_bytes(bytes(range(256)) if kind == "binary" else b"[nothing]\n")
    said = refused(*WITH_MIRROR[command], PAPER, "--mirror", "my mirror.toml")
    assert said.startswith("microrad: ") and "my mirror.toml" in said


@pytest.mark.parametrize("command", [("jitter", PAPER, "{}"), ("pointing", PAPER, "--sources", "{}")])
@pytest.mark.parametrize("kind", ["missing", "empty", "binary"])
def test_a_second_file_of_a_command_is_named_where_it_cannot_be_read(refused, folder, command, kind):
    *rest, name = (str(part).format("my list.csv") for part in command)
    if kind != "missing":
        (folder / name).write_bytes(b"" if kind == "empty" else bytes(range(256)) * 10)
    said = refused(*rest, name)
    assert said.startswith("microrad: ") and name in said
