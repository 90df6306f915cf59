"""What the studio offers to copy: the command and the lines of Python do the same, and give the same numbers."""

import contextlib
import io
import json
import re
import shlex
import shutil
from pathlib import Path

import pytest

import microrad
from cli.test_cli import write_recording
from microrad import cli, report
from microrad.core.folder import FolderError
from microrad.lab.recording import RecordingError, read_in, read_recording
from microrad.loop import control
from microrad.loop.controller_study import designs
from microrad.mission.toml import MissionError
from microrad.orbit.day import assumptions
from microrad.report.study.page import StudyFigures
from microrad.studio import commands
from microrad.study import study
from shipped import SHIPPED, without_day, without_fine_pointing
from small_campaign import campaign_file

MISSION = Path("my mission.toml")


@pytest.fixture
def home(folder):
    """A current folder with the paper's mission in it, without its fine-pointing loop and its day."""
    (folder / MISSION).write_text(without_day(without_fine_pointing(SHIPPED.read_text("utf-8"))), encoding="utf-8")
    return folder


def typed(line, capsys):
    """What a line prints that is typed into a shell, and its exit code."""
    program, *arguments = shlex.split(line)
    assert program == "microrad"
    with pytest.raises(SystemExit) as stop:
        cli.app(args=arguments, prog_name="microrad")
    out, err = capsys.readouterr()
    return out, int(stop.value.code or 0), err


def executed(text):
    """What lines of Python print."""
    with contextlib.redirect_stdout(io.StringIO()) as out:
        exec(compile(text, "copied.py", "exec"), {"__name__": "copied"})
    return out.getvalue()


def once(compute):
    """The same computation, which takes long, once for the same mission; there is one scene in these tests."""
    known = {}

    def found(of, *rest):
        key = rest[0] if rest and not callable(rest[0]) else getattr(of, "sha256", "scene")
        if key not in known:
            known[key] = compute(of, *rest)
        return known[key]

    return found


# ------------------------------------------------------------------------------------------------------- same numbers
@pytest.mark.promise("studio-1", "studio-14")
@pytest.mark.parametrize(
    "action",
    [commands.budget(MISSION), commands.contacts(MISSION)],
)
def test_what_prints_prints_the_same(home, capsys, monkeypatch, action):
    if action.arguments[0] == "contacts":
        shutil.copyfile(SHIPPED, home / MISSION)
        changed = assumptions._changes
        monkeypatch.setattr(assumptions, "_changes", lambda *args: list(changed(*args))[::5])  # each takes a day's time
    out, code, err = typed(action.command, capsys)
    assert (code in (0, 1), err) == (True, "")
    assert executed(action.python) == out
    assert len(out.splitlines()) > 20


@pytest.mark.promise("readme-1")
@pytest.mark.promise("studio-14")
def test_a_study_gives_the_same_verdict_and_the_same_files(home, capsys, monkeypatch):
    monkeypatch.setattr(study, "run_study", once(study.run_study))
    monkeypatch.setattr(microrad, "run_study", study.run_study, raising=False)
    monkeypatch.setattr(report, "study_figures", lambda *args: StudyFigures())
    action, again = commands.study(MISSION, Path("out")), commands.study(MISSION, Path("out again"))
    out, _, _ = typed(action.command, capsys)
    assert executed(again.python).strip() == out[: out.index("\n\nout/report.html")]
    first, second = (json.loads((home / each.results[2]).read_text("utf-8")) for each in (action, again))
    assert first["mission"] == second["mission"]
    assert all(Path(name).is_file() for name in (*action.results, *again.results))
    with pytest.raises(FolderError, match="already holds results"):
        executed(action.python)


@pytest.mark.promise("studio-14")
@pytest.mark.parametrize("family", [control.PI, pytest.param(control.LQG, marks=pytest.mark.endurance)])
def test_controllers_are_designed_alike(family, folder, capsys, monkeypatch):
    monkeypatch.setattr(designs, "families", lambda m: (family,))
    (folder / MISSION).write_text(SHIPPED.read_text("utf-8"), encoding="utf-8")
    out, code, _ = typed(commands.design(MISSION).command, capsys)
    assert code == ("refused" in out)
    listed = re.findall(r"(\d+\.\d{3}) +(\d+\.\d{3}) (?:refused)? +(\d\.\d{3}) ", out)
    found = [(*row[28:].split()[:2], row.split()[-1]) for row in executed(commands.design(MISSION).python).splitlines()]
    assert found == listed
    assert len(found) >= 3


@pytest.mark.promise("studio-14")
@pytest.mark.usefixtures("undrawn")
def test_a_mirror_is_identified_alike(folder, capsys):
    write_recording(folder / "a loop.csv")
    action = commands.identify(
        (Path("a loop.csv"),), "drive", "angle", Path("one.toml"), name="a loop", rate_hz=1000.0, static=True
    )
    out, code, err = typed(action.command, capsys)
    assert code == 0, err
    mirror, page = map(Path, action.results)
    written = mirror.read_bytes()
    assert page.is_file()
    with pytest.raises(FileExistsError):
        executed(action.python)
    mirror.unlink()
    page.unlink()
    printed = executed(action.python)
    assert (mirror.read_bytes(), page.is_file()) == (written, True)
    assert printed.strip() == out.partition("\n\n")[2].strip()


@pytest.mark.usefixtures("undrawn")
def test_every_choice_of_an_identification_is_in_both(folder, capsys):
    for name in ("a.csv", "-b.csv"):
        write_recording(folder / name, reverse=False)
    text = (folder / "-b.csv").read_text("utf-8").splitlines()
    (folder / "-b.csv").write_text("\n".join([text[0], *text[101:]]), encoding="utf-8")
    action = commands.identify(
        (Path("a.csv"),),
        "1",
        "2",
        Path("two.toml"),
        name='it\'s "mine"',
        units=("V", "um"),
        rate_hz=1000.0,
        validate=(Path("-b.csv"),),
        lever_arm_m=0.05,
        static=True,
        admissible=True,
    )
    out, code, err = typed(action.command, capsys)
    assert code == 0, err
    written = Path("two.toml").read_bytes()
    for name in action.results:
        Path(name).unlink()
    assert executed(action.python).strip() == out.partition("\n\n")[2].strip()
    assert Path("two.toml").read_bytes() == written
    assert b"it's" in written


@pytest.mark.parametrize(
    ("header", "drive", "output", "words"),
    [
        ("time [s],drive [V],angle [urad]", "V", "urad", None),
        ("time [s],drive [V],angle [µrad]", "V", "mrad", "the output is to be read in mrad and the file says urad"),
        ("time [s],drive [mV],angle [urad]", "V", "urad", "the drive is to be read in V and the file says mV"),
    ],
)
def test_units_that_the_file_denies_are_refused_in_both(folder, capsys, header, drive, output, words):
    write_recording(folder / "a.csv")
    _, *rows = (folder / "a.csv").read_text("utf-8").splitlines()
    (folder / "a.csv").write_text("\n".join([header, *rows]), encoding="utf-8")
    action = commands.identify(
        (Path("a.csv"),), "1", "2", Path("m.toml"), name="a", units=(drive, output), rate_hz=1000.0, static=True
    )
    if words is None:
        assert read_in(read_recording("a.csv", "1", "2", 1000.0), drive, output).samples == len(rows)
        return
    with pytest.raises(RecordingError, match=f"^a.csv: {words}; give the unit that the file says"):
        executed(action.python)
    _, code, err = typed(action.command, capsys)
    assert code != 0
    assert "give what the files say" in err


@pytest.mark.promise("studio-14")
@pytest.mark.usefixtures("rows_here")
def test_a_campaign_gives_the_same_rows(folder, capsys):
    campaign_file(folder, runs=32)
    action, again = (commands.campaign(Path("campaign.toml"), Path(f"{name}.ledger")) for name in ("one", "two"))
    out, code, err = typed(action.command, capsys)
    assert (code in (0, 1), err) == (True, "")
    assert all(Path(name).is_file() for name in action.results)
    printed = executed(again.python)
    assert rows(printed) == rows(out)
    assert rows(typed(commands.resume(Path("one.ledger")).command, capsys)[0]) == rows(out)
    assert rows(executed(commands.resume(Path("two.ledger")).python)) == rows(out)
    assert len(rows(out)) > 5


def rows(text):
    """What a campaign's words say, but for the name of the ledger and the time that it took."""
    return [line for line in text.splitlines() if line.strip() and "ledger" not in line and " s" not in line]


# ------------------------------------------------------------------------------------------------------ as it is typed
@pytest.mark.parametrize(
    ("action", "line"),
    [
        (commands.budget(Path("-x.toml")), "microrad budget ./-x.toml"),
        (commands.contacts(Path("a b.toml")), "microrad contacts 'a b.toml'"),
        (commands.design(Path("$(rm).toml")), "microrad design '$(rm).toml'"),
        (commands.study(Path("a.toml"), Path("-o")), "microrad run a.toml --output ./-o"),
        (commands.resume(Path("c.ledger")), "microrad campaign resume c.ledger"),
        (
            commands.identify((Path("l.csv"),), "0", "-1", Path("m.toml"), name="-1 m", accept=("a", "b")),
            "microrad identify l.csv --input 0 --output=-1 --accept a --accept b --input-unit V --output-unit mrad "
            "'--name=-1 m' --mirror-file m.toml",
        ),
    ],
)
def test_a_line_is_safe_to_paste(action, line):
    assert action.command == line
    assert shlex.split(line) == ["microrad", *action.arguments]


@pytest.mark.parametrize("name", ["a'b", 'a"b', "a\\b", "a\nb", "'); raise SystemExit('x"])
def test_a_name_stays_a_name_in_python(folder, name):
    of = Path(name)
    for action in (commands.budget(of), commands.contacts(of), commands.design(of), commands.study(of, of)):
        with pytest.raises(MissionError, match="does not exist"):
            executed(action.python)


def test_only_what_writes_has_results():
    assert not any(make(MISSION).results for make in (commands.budget, commands.contacts, commands.design))
    assert commands.study(MISSION, Path("o")).results == ("o/report.html", "o/results.nc", "o/manifest.json")
    run, resumed = commands.campaign(Path("c.toml"), Path("c.ledger")), commands.resume(Path("c.ledger"))
    assert run.results == resumed.results == ("c.ledger",)


@pytest.mark.parametrize(
    ("action", "arguments", "title", "results"),
    [
        (
            commands.study(Path("a b.toml"), Path("-out")),
            ("run", "a b.toml", "--output", "./-out"),
            "Study of a b.toml",
            ("-out/report.html", "-out/results.nc", "-out/manifest.json"),
        ),
        (
            commands.campaign(Path("-c.toml"), Path("-t.ledger")),
            ("campaign", "run", "./-c.toml", "--ledger", "./-t.ledger"),
            "Campaign -c.toml",
            ("-t.ledger",),
        ),
        (
            commands.resume(Path("-t.ledger")),
            ("campaign", "resume", "./-t.ledger"),
            "Campaign -t.ledger, going on",
            ("-t.ledger",),
        ),
        (
            commands.campaign_report(Path("t.ledger"), Path("p.html")),
            ("campaign", "report", "t.ledger", "p.html", "--overwrite"),
            "Report of t.ledger",
            ("p.html",),
        ),
    ],
)
def test_what_is_run_has_its_arguments_its_title_and_its_results(action, arguments, title, results):
    assert (action.arguments, action.title, action.results) == (arguments, title, results)


def test_the_report_of_a_ledger_is_written_by_the_lines_of_python(folder, monkeypatch):
    from microrad.campaign.statistics import summary
    from microrad.report.campaign import page

    monkeypatch.setattr(summary, "summarise_campaign", lambda ledger: ("summary of", ledger))
    monkeypatch.setattr(page, "campaign_page", lambda found: f"{found[0]} {found[1]}, µ")
    assert executed(commands.campaign_report(Path("it's.ledger"), Path('"p".html')).python) == ""
    assert Path('"p".html').read_text("utf-8") == "summary of it's.ledger, µ"
    assert not Path("it's.ledger").exists()


def test_a_campaign_goes_on_from_its_own_ledger_in_python(monkeypatch):
    from microrad.campaign import run
    from microrad.campaign.statistics import summary
    from microrad.report.campaign import text

    done = []
    monkeypatch.setattr(run, "run_campaign", lambda *given: done.append(given))
    monkeypatch.setattr(run, "resume_campaign", lambda *given: done.append(given))
    monkeypatch.setattr(summary, "summarise_campaign", lambda ledger: ledger)
    monkeypatch.setattr(text, "campaign_text", lambda found, width: f"{found} in {width} columns")
    assert executed(commands.campaign(Path("c.toml"), Path("one.ledger")).python) == "one.ledger in 80 columns\n"
    assert executed(commands.resume(Path("two.ledger")).python) == "two.ledger in 80 columns\n"
    assert done == [(Path("c.toml"), Path("one.ledger"), run.Means()), (Path("two.ledger"), run.Means())]


def test_an_identification_of_several_files_is_called_alike_in_both(monkeypatch, folder):
    from microrad.lab import identify, recording

    action = commands.identify(
        (Path("a.csv"), Path("-b.csv")),
        "3",
        "2",
        Path("up/m.toml"),
        name="n",
        units=("mV", "um"),
        rate_hz=1250.5,
        accept=("clipping", "drift"),
        validate=(Path("c.csv"), Path("-d.csv")),
        lever_arm_m=0.0375,
        admissible=True,
    )
    assert action.command == (
        "microrad identify a.csv ./-b.csv --input 3 --output 2 --rate 1250.5 --accept clipping --accept drift "
        "--validate c.csv --validate ./-d.csv --input-unit mV --output-unit um --lever-arm '0.0375 m' --name n "
        "--mirror-file up/m.toml --admissible"
    )
    assert (action.title, action.results) == ("identify n", ("up/m.toml", "up/m.html"))
    asked = []
    monkeypatch.setattr(microrad, "read_recording", lambda *given, **more: given + tuple(more.items()), raising=False)
    monkeypatch.setattr(recording, "read_in", lambda found, drive, output: (*found, drive, output))

    def stopped(*given, **more):
        asked.append((given, more))
        raise SystemExit("enough")

    monkeypatch.setattr(identify, "identify", stopped)
    with pytest.raises(SystemExit, match="enough"):
        executed(action.python)
    ((recordings,), how) = asked[0]
    rest = "3", "2", 1250.5, ("accept", ("clipping", "drift")), "mV", "um"
    assert recordings == [("a.csv", *rest), ("-b.csv", *rest)]
    assert how == {
        "models": identify.MODELS,
        "validation": [("c.csv", *rest), ("-d.csv", *rest)],
        "lever_arm_m": 0.0375,
        "admissible": True,
        "input_unit": "mV",
        "output_unit": "um",
    }


ODD_NAMES = ["a'b", 'a"b', "a\\b", "a\nb", "'); raise SystemExit('x"]


@pytest.mark.parametrize("name", ODD_NAMES)
def test_names_of_a_campaign_and_its_ledger_stay_names_in_python(folder, monkeypatch, name):
    from microrad.campaign import run
    from microrad.campaign.statistics import summary
    from microrad.report.campaign import page, text

    done = []
    monkeypatch.setattr(run, "run_campaign", lambda *given: done.append(given[:-1]))
    monkeypatch.setattr(run, "resume_campaign", lambda *given: done.append(given[:-1]))
    monkeypatch.setattr(summary, "summarise_campaign", lambda ledger: ledger)
    monkeypatch.setattr(text, "campaign_text", lambda found, width: f"text of {found}")
    monkeypatch.setattr(page, "campaign_page", lambda found: f"page of {found}")
    file, ledger, written = Path(name), Path(f"{name}.ledger"), Path(f"{name}.html")
    assert executed(commands.campaign(file, ledger).python) == f"text of {ledger}\n"
    assert executed(commands.resume(ledger).python) == f"text of {ledger}\n"
    assert executed(commands.campaign_report(ledger, written).python) == ""
    assert done == [(file, ledger), (ledger,)]
    assert [(each.name, each.read_text("utf-8")) for each in folder.iterdir()] == [(written.name, f"page of {ledger}")]


@pytest.mark.parametrize("name", ODD_NAMES)
def test_every_word_of_an_identification_stays_a_word_in_python(folder, monkeypatch, name):
    from microrad.lab import identify, recording

    of = {
        key: f"{key} {name}" for key in ("file", "drive", "output", "mirror", "V", "mrad", "finding", "check", "called")
    }
    read, written = [], []
    monkeypatch.setattr(microrad, "read_recording", lambda *given, **more: (*given, *more.values()), raising=False)
    monkeypatch.setattr(recording, "read_in", lambda found, drive, output: read.append((*found, drive, output)))
    found = type("Found", (), {"unsupported": "", "chosen": "linear"})
    monkeypatch.setattr(identify, "identify", lambda recordings, **how: written.append(how) or found)
    monkeypatch.setattr(identify, "mirror_file_text", lambda found, called, model: f"{called} as {model}")
    monkeypatch.setattr(
        report, "write_identification", lambda found, page, **more: written.append((page, more["title"]))
    )
    monkeypatch.setattr(report, "identification_text", lambda found, model, **files: " ".join(map(str, files.values())))
    action = commands.identify(
        (Path(of["file"]),),
        of["drive"],
        of["output"],
        Path(of["mirror"]),
        name=of["called"],
        units=(of["V"], of["mrad"]),
        accept=(of["finding"],),
        validate=(Path(of["check"]),),
    )
    mirror = Path(of["mirror"])
    page = mirror.with_suffix(".html")
    assert executed(action.python) == f"{mirror} {page}\n"
    rest = of["drive"], of["output"], None, (of["finding"],), of["V"], of["mrad"]
    assert sorted(read) == sorted([(of["file"], *rest), (of["check"], *rest)])
    how, report_of = written
    assert (how["input_unit"], how["output_unit"], how["lever_arm_m"]) == (of["V"], of["mrad"], None)
    assert report_of == (page, of["called"])
    assert mirror.read_text("utf-8") == f"{of['called']} as linear"


@pytest.mark.parametrize("make", [commands.budget, commands.contacts, commands.design])
def test_what_only_prints_is_typed_with_its_file_and_is_no_job(make):
    action = make(Path("-my mission.toml"))
    assert action.arguments == (make.__name__, "./-my mission.toml")
    assert action.command == f"microrad {make.__name__} './-my mission.toml'"
    assert (action.title, action.results) == ("", ())


def test_a_report_of_a_ledger_is_typed_with_both_files_as_files():
    action = commands.campaign_report(Path("-t.ledger"), Path("-my page.html"))
    assert action.command == "microrad campaign report ./-t.ledger './-my page.html' --overwrite"
    assert (action.title, action.results) == ("Report of -t.ledger", ("-my page.html",))


@pytest.mark.parametrize(
    ("options", "python", "typed_as"),
    [
        ({}, ("identify.MODELS", "admissible=False"), ""),
        ({"static": True}, ("identify.STATIC[:2]", "admissible=False"), " --static"),
        ({"admissible": True}, ("identify.MODELS", "admissible=True"), " --admissible"),
        ({"static": True, "admissible": True}, ("identify.STATIC[:2]", "admissible=True"), " --static --admissible"),
    ],
)
def test_each_switch_of_an_identification_is_its_own(options, python, typed_as):
    action = commands.identify((Path("a.csv"),), "0", "1", Path("m.toml"), name="n", **options)
    assert f"models={python[0]}, " in action.python and f" {python[1]}, " in action.python
    assert action.command.endswith(f"--name n --mirror-file m.toml{typed_as}")


def test_recordings_that_a_line_of_python_cannot_fit_end_it_with_the_reason_and_write_nothing(folder, monkeypatch):
    from microrad.lab import identify, recording

    monkeypatch.setattr(microrad, "read_recording", lambda *given, **more: given, raising=False)
    monkeypatch.setattr(recording, "read_in", lambda found, drive, output: found)
    found = type("Found", (), {"unsupported": "a line does as well", "chosen": "linear"})
    monkeypatch.setattr(identify, "identify", lambda recordings, **how: found)
    action = commands.identify((Path("a.csv"),), "0", "1", Path("m.toml"), name="n")
    with pytest.raises(SystemExit, match=r"^a line does as well$"):
        executed(action.python)
    assert list(folder.iterdir()) == []
