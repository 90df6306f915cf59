"""Commands that take a design out of microrad and a linear model in: what they write, print and refuse."""

import hashlib
import json
import re
import shutil
import zipfile
from pathlib import Path
from types import SimpleNamespace

import pytest

from microrad.cli import export as cli_export
from microrad.export import choice
from microrad.export import matrices as linear
from microrad.export.flight import build, write
from microrad.export.fmi import fmu
from microrad.export.linear_import import Given
from microrad.export.records import ExportError
from microrad.loop import controller_study
from microrad.mission.file import load_mirror, load_mission
from shipped import SHIPPED, without_fine_pointing

needs_a_compiler = pytest.mark.skipif(build.compiler() is None, reason="no C compiler")

IMPORT = (
    *("--travel", "2.5 mrad", "--drive", "0 V", "12 V", "--bias", "6 V", "--rate-limit", "3770 V/s"),
    *("--band", "1 Hz", "5 kHz", "--normalise-at", "2 Hz", "--output-unit", "rad"),
)


@pytest.fixture
def mission(folder):
    """The paper's mission in the current folder."""
    (folder / "leo-geo.toml").write_text(SHIPPED.read_text(encoding="utf-8"), encoding="utf-8")
    return folder


# --------------------------------------------------------------------------------------------------------------- C code
@pytest.mark.promise("readme-14")
@pytest.mark.promise("export-2", "export-14")
@needs_a_compiler
@pytest.mark.parametrize("precision", ["double", pytest.param("single", marks=pytest.mark.endurance), "fixed"])
def test_a_controller_becomes_code_that_keeps_to_the_kernel(mission, call, precision):
    done = call("export", "c", "leo-geo.toml", "--controller", "PID + inverse", "--precision", precision, "--json")
    assert done.code == 0, done.err
    found = json.loads(done.out)
    bench = found["bench"]
    assert (found["controller"], found["precision"], found["folder"]) == (
        "PID + inverse",
        precision,
        "leo-geo-pid_inverse",
    )
    assert bench["samples"] == 5000
    assert bench["largest_difference_v"] <= bench["bound_v"] < 1e-3
    assert bench["peak_command_v"] > 3.0  # the scenario drives the mirror over more than half of its range
    assert 0 < found["operations"]["multiplications"] < 1000


@pytest.mark.promise("readme-13")
@pytest.mark.promise("export-4", "export-5")
@needs_a_compiler
@pytest.mark.promise("readme-25")
def test_the_folder_holds_sources_vectors_and_hashes_and_nothing_compiled(mission, call):
    done = call("export", "c", "leo-geo.toml", "--controller", "PID", "--name", "mirror_loop", "--output", "flight")
    assert done.code == 0, done.err
    files = {path.name for path in (mission / "flight").iterdir()}
    sources = {"mirror_loop.h", "mirror_loop.c", "mirror_loop_bench.c", "Makefile"}
    assert files == {*sources, "vectors.csv", "report.txt", "manifest.json"}
    manifest = json.loads((mission / "flight" / "manifest.json").read_text(encoding="utf-8"))
    assert manifest["mission"]["sha256"] == hashlib.sha256((mission / "leo-geo.toml").read_bytes()).hexdigest()
    for name, digest in manifest["files_sha256"].items():
        assert hashlib.sha256((mission / "flight" / name).read_bytes()).hexdigest() == digest
    assert "at most" in done.out and "off the kernel" in done.out
    assert manifest["mission"]["sha256"] in (mission / "flight" / "mirror_loop.h").read_text(encoding="utf-8")


def test_without_a_compiler_the_code_is_written_and_that_is_said(mission, call, monkeypatch):
    monkeypatch.setattr(build, "COMPILERS", ())
    monkeypatch.delenv("CC", raising=False)
    done = call("export", "c", "leo-geo.toml", "--controller", "PID")
    assert done.code == 0, done.err
    assert "there is no C compiler here" in done.out
    assert (mission / "leo-geo-pid" / "pid.c").is_file()


def test_results_are_replaced_only_when_asked_to(mission, call, refused):
    words = ("export", "c", "leo-geo.toml", "--controller", "PID")
    assert call(*words).code == 0
    assert "already holds exported code" in refused(*words)
    assert call(*words, "--overwrite").code == 0
    (mission / "mine").mkdir()
    (mission / "mine" / "thesis.txt").write_text("mine", encoding="utf-8")
    assert "not exported code" in refused(*words, "--output", "mine", "--overwrite")
    assert (mission / "mine" / "thesis.txt").read_text(encoding="utf-8") == "mine"


@pytest.mark.promise("export-27")
@pytest.mark.parametrize(
    ("extra", "words"),
    [
        (("--controller", "PDI"), "has no controller 'PDI'; it has: PI, best of a gain grid; PI;"),
        (("--controller", "PID", "--name", "7up"), "'7up' is no name for exported code"),
        (("--controller", "PID", "--name", "for"), "it is a keyword of C"),
        (("--controller", "PID", "--name", "exp"), "exp"),
    ],
)
def test_code_that_cannot_be_is_refused_with_the_reason(mission, refused, extra, words):
    assert words in refused("export", "c", "leo-geo.toml", *extra)


@pytest.mark.promise("export-27")
def test_a_mirror_without_an_inverse_is_refused_where_one_is_asked_for(mission, refused):
    text = (mission / "leo-geo.toml").read_text(encoding="utf-8")
    begin, end = text.index("[mirror.bouc_wen]"), text.index("# A set with the same slow loop")
    plays = '[mirror.prandtl_ishlinskii]\nthresholds = ["0 V", "1 V"]\nweights = ["0 urad/V", "89 urad/V"]\n\n'
    (mission / "stuck.toml").write_text(text[:begin] + plays + text[end:], encoding="utf-8")
    said = refused("export", "c", "stuck.toml", "--controller", "PID + inverse")
    assert "stuck.toml" in said and "stands still after each reversal and has no inverse" in said


def test_a_compiler_that_is_not_there_is_refused_and_nothing_is_written(mission, refused, monkeypatch):
    monkeypatch.setenv("CC", "no-such-compiler")
    assert "CC is 'no-such-compiler'" in refused("export", "c", "leo-geo.toml", "--controller", "PID")


# ----------------------------------------------------------------------------------------------------------------- FMU
@pytest.mark.promise("readme-13")
@pytest.mark.parametrize(
    ("extra", "name", "version"),
    [
        ((), "leo-geo-mirror.fmu", "2.0"),
        (("--loop", "control", "--fmi", "3.0"), "leo-geo-mirror.fmu", "3.0"),
        (("--controller", "PID + inverse"), "leo-geo-pid_inverse_loop.fmu", "2.0"),
    ],
)
@pytest.mark.promise("readme-25")
def test_a_unit_is_written_with_its_description(mission, call, extra, name, version):
    done = call("export", "fmu", "leo-geo.toml", *extra)
    assert done.code == 0, done.err
    assert done.out.startswith(f"{name}: FMI {version}")
    with zipfile.ZipFile(mission / name) as archive:
        description = archive.read("modelDescription.xml").decode()
    assert f'fmiVersion="{version}"' in description
    assert ("reference_rad" in description) == ("--controller" in extra)


def test_a_unit_does_not_replace_other_files(mission, call, refused):
    (mission / "mine.fmu").write_text("not a unit", encoding="utf-8")
    assert "left as it is" in refused("export", "fmu", "leo-geo.toml", "--output", "mine.fmu")
    assert "was not written by microrad" in refused(
        "export", "fmu", "leo-geo.toml", "--output", "mine.fmu", "--overwrite"
    )
    assert call("export", "fmu", "leo-geo.toml", "--loop", "control").code == 0
    assert call("export", "fmu", "leo-geo.toml", "--loop", "control", "--overwrite").code == 0


def test_a_controller_and_a_loop_exclude_each_other(mission, refused):
    said = refused("export", "fmu", "leo-geo.toml", "--loop", "control", "--controller", "PID")
    assert "--controller and --loop exclude each other" in said


def test_a_loop_that_the_mission_does_not_have_is_refused(mission, refused):
    text = (mission / "leo-geo.toml").read_text(encoding="utf-8")
    (mission / "bare.toml").write_text(without_fine_pointing(text), encoding="utf-8")
    assert "has no loop 'fine_pointing'" in refused("export", "fmu", "bare.toml", "--loop", "fine_pointing")


# ------------------------------------------------------------------------------------------------------------- matrices
@pytest.mark.promise("readme-13")
@pytest.mark.promise("export-33")
@pytest.mark.promise("readme-25")
def test_matrices_go_to_a_matlab_file_and_to_json(mission, call):
    scipy_io = pytest.importorskip("scipy.io")
    done = call("export", "matrices", "leo-geo.toml", "--controller", "PID + inverse")
    assert done.code == 0, done.err
    read = scipy_io.loadmat(mission / "leo-geo.mat", squeeze_me=True)
    assert {"linear_part", "mirror", "sampled_plant", "controller", "loop"} <= set(read)
    printed = call("export", "matrices", "leo-geo.toml", "--json")
    assert "linear_part" in printed.out and json.loads(printed.out)


# --------------------------------------------------------------------------------------------------------------- import
@pytest.mark.promise("readme-13")
@pytest.mark.promise("export-1", "export-36")
@pytest.mark.promise("readme-25")
def test_a_linear_model_makes_a_mirror_file(mission, call):
    assert call("export", "matrices", "leo-geo.toml", "--output", "models.mat").code == 0
    done = call("import", "models.mat", "--variable", "mirror", *IMPORT)
    assert done.code == 0, done.err
    assert "models-mirror.toml written" in done.out
    made = load_mirror(mission / "models-mirror.toml").mirror
    assert made.drive_max_v == 12.0
    assert made.prandtl_ishlinskii is not None
    assert made.prandtl_ishlinskii.weights_rad_v == pytest.approx((8.9e-5,), rel=1e-9)  # d1


@pytest.mark.promise("export-36")
def test_what_a_linear_model_does_not_say_has_a_unit(mission, call, refused):
    assert call("export", "matrices", "leo-geo.toml", "--output", "models.mat").code == 0
    words = ["6" if each == "6 V" else each for each in IMPORT]
    assert '--bias: "6" is a number without a unit' in refused("import", "models.mat", "--variable", "mirror", *words)
    assert "models.mat" in refused("import", "models.mat", *IMPORT)  # two models, and none is chosen
    assert re.search("No such file|cannot be read|is not there", refused("import", "none.mat", *IMPORT))


def test_an_imported_mirror_does_not_replace_other_files(mission, call, refused):
    assert call("export", "matrices", "leo-geo.toml", "--output", "models.mat").code == 0
    shutil.copy(mission / "leo-geo.toml", mission / "mine.toml")
    words = ("import", "models.mat", "--variable", "mirror", *IMPORT, "--output", "mine.toml")
    assert "left as it is" in refused(*words)
    assert "was not written by microrad" in refused(*words, "--overwrite")


@pytest.mark.promise("export-4")
def test_the_controllers_are_those_of_design_and_of_the_table_control(mission, refused):
    m = load_mission(mission / "leo-geo.toml").mission
    said = refused("export", "c", "leo-geo.toml", "--controller", "none").strip().removesuffix(" (see docs/export.md)")
    listed = said.partition("it has: ")[2].split("; ")
    assert listed == [*controller_study.offered(m.fine_pointing, m.mirror), "PID", "PID + inverse"]
    assert len(listed) > 6


# ------------------------------------------------------------------------------------------ what goes without saying
@pytest.fixture
def loaded(monkeypatch):
    """Sets the loop that the command sees: with a table [fine_pointing] or none, with a mirror of several axes."""

    def load(fine_pointing, several=None):
        found = SimpleNamespace(mission=SimpleNamespace(fine_pointing=fine_pointing)), several
        monkeypatch.setattr(cli_export, "_loaded", lambda file, mirror: found)

    return load


@pytest.mark.parametrize(
    ("loop", "given", "controller", "name"),
    [
        (("loop", None), (), "PI + inverse", "pi_inverse"),
        ((None, None), (), "PID + inverse", "pid_inverse"),
        (("loop", "mirror"), (), "PI + notch", "pi_notch"),
        (("loop", "mirror"), ("--controller", "LQG"), "LQG", "lqg"),
        ((None, None), ("--controller", "PID", "--name", "Mine"), "PID", "Mine"),
    ],
)
def test_code_is_of_the_controller_that_the_loop_of_the_mission_suggests(
    call, folder, loaded, monkeypatch, loop, given, controller, name
):
    written = []
    loaded(*loop)
    monkeypatch.setattr(cli_export, "_chosen", lambda mission, mirror, wanted, progress: (mirror, wanted))
    monkeypatch.setattr(write, "export_flight", lambda chosen, to, **options: written.append((chosen, to, options)))
    monkeypatch.setattr(write, "export_data", lambda found: {})
    monkeypatch.setattr(write, "report_text", lambda found: "report")
    result = call("export", "c", "some/day.toml", *given)
    ((chosen, to, options),) = written
    assert (result.code, result.out) == (0, f"report\n\nday-{name}\n")
    assert (chosen, str(to), options["name"]) == ((loop[1], controller), f"day-{name}", name)
    assert (options["precision"], options["overwrite"], options["accept"]) == ("double", False, False)
    result = call("export", "c", "day.toml", *given, "--output", "out", "--overwrite", "--accept", "--json")
    _, to, options = written[-1]
    assert json.loads(result.out) == {"folder": "out"}
    assert (str(to), options["overwrite"], options["accept"]) == ("out", True, True)


@pytest.mark.parametrize(
    ("table", "given", "of", "name"),
    [
        ("loop", (), "fine_pointing", "mirror"),
        (None, (), "control", "mirror"),
        ("loop", ("--loop", "control"), "control", "mirror"),
        (None, ("--loop", "fine_pointing", "--name", "fsm"), "fine_pointing", "fsm"),
        ("loop", ("--controller", "LQG"), "LQG", "lqg_loop"),
        ("loop", ("--controller", "LQG", "--name", "fsm"), "LQG", "fsm"),
    ],
)
def test_a_unit_is_of_the_loop_that_the_mission_has(call, folder, loaded, monkeypatch, table, given, of, name):
    written = []
    loaded(table, "axes")
    monkeypatch.setattr(choice, "plant_unit", lambda mission, table, several: (table, several))
    monkeypatch.setattr(choice, "loop_unit", lambda chosen: chosen)
    monkeypatch.setattr(cli_export, "_promised", lambda mission, several, name, accept, progress: (name, several))
    monkeypatch.setattr(fmu, "write_unit", lambda *args: written.append(args) or SimpleNamespace(words="written"))
    assert call("export", "fmu", "some/day.toml", *given) == (0, "written\n", "")
    ((unit, path, version, called),) = written
    assert (unit, str(path), version, called) == ((of, "axes"), f"day-{name}.fmu", "2.0", name)


@pytest.mark.parametrize(
    ("table", "several", "name", "coupled"),
    [
        (None, None, "PID", False),
        (SimpleNamespace(mirror_file="m.toml"), None, "LQG", False),
        (SimpleNamespace(mirror_file="m.toml"), "axes", "LQG", True),
        (SimpleNamespace(mirror_file="m.toml"), "axes", "PID", False),
        (SimpleNamespace(mirror_file="m.toml"), "axes", "PID + inverse", False),
        (SimpleNamespace(mirror_file=None), "axes", "PID", True),
        (SimpleNamespace(mirror_file=None), "axes", "LQG", True),
        (None, "axes", "PID + inverse", True),
    ],
)
def test_the_papers_loop_has_the_missions_own_mirror_unless_another_is_given_by_hand(
    monkeypatch, table, several, name, coupled
):
    mission = SimpleNamespace(mission=SimpleNamespace(fine_pointing=table))
    monkeypatch.setattr(choice, "choose", lambda *args: ("one axis", *args))
    monkeypatch.setattr(choice, "choose_coupled", lambda *args: ("several axes", *args))
    found = cli_export._chosen(mission, several, name, "progress")
    axes = ("several axes", mission, several) if coupled else ("one axis", mission)
    assert found == (*axes, name, "progress")


@pytest.mark.parametrize(("given", "name"), [((), "model 3"), (("--name", "fsm"), "fsm")])
def test_an_imported_mirror_is_called_as_its_file_or_as_is_said(call, folder, monkeypatch, given, name):
    taken = []
    monkeypatch.setattr(
        "microrad.export.linear_import.import_mat", lambda file, said, variable: taken.append((said, variable)) or "#"
    )
    result = call("import", "sub/model 3.mat", *IMPORT, *given)
    next_is = "microrad run leo-geo.toml --mirror 'model 3-mirror.toml'"
    assert (result.code, result.out) == (0, f"model 3-mirror.toml written. Next: {next_is}\n")
    ((said, variable),) = taken
    assert call("import", "sub/model 3.mat", *IMPORT, "--output=-m.toml").out.endswith(" --mirror ./-m.toml\n")
    assert (said.name, variable, said.output_unit) == (name, None, "rad")
    numbers = said.travel_rad, said.rate_limit_v_s, said.bias_v, said.drive_min_v, said.drive_max_v
    assert numbers == pytest.approx((2.5e-3, 3770.0, 6.0, 0.0, 12.0), rel=1e-12)
    assert (said.excited_from_hz, said.excited_to_hz, said.normalise_at_hz) == (1.0, 5000.0, 2.0)


def test_each_number_of_an_import_is_that_of_its_own_option(call, folder, monkeypatch):
    taken = []
    monkeypatch.setattr("microrad.export.linear_import.import_mat", lambda *given: taken.append(given) or "# Mirror")
    options = (
        *("--travel", "3.5 mrad", "--drive", "-7 V", "13 V", "--bias", "2500 mV", "--rate-limit", "4.5 kV/s"),
        *("--band", "3 Hz", "6.25 kHz", "--normalise-at", "11 Hz", "--output-unit", "urad", "--variable", "sys"),
    )
    (folder / "sub").mkdir()
    result = call("import", "sub/m.mat", *options, "--output", "sub/it is.toml")
    assert result.out == "sub/it is.toml written. Next: microrad run leo-geo.toml --mirror 'sub/it is.toml'\n"
    ((file, given, variable),) = taken
    assert (str(file), variable) == ("sub/m.mat", "sys")
    assert given == Given(
        name="m",
        travel_rad=pytest.approx(3.5e-3),
        rate_limit_v_s=pytest.approx(4500.0),
        bias_v=pytest.approx(2.5),
        drive_min_v=-7.0,
        drive_max_v=13.0,
        excited_from_hz=3.0,
        excited_to_hz=pytest.approx(6250.0),
        normalise_at_hz=11.0,
        output_unit="urad",
    )


@pytest.mark.parametrize(
    ("option", "value", "words"),
    [
        ("--travel", ("3 V",), "--travel: "),
        ("--drive", ("0 V", "12"), "--drive: "),
        ("--drive", ("zero", "12 V"), "--drive: "),
        ("--bias", ("6 mrad",), "--bias: "),
        ("--rate-limit", ("3770 V",), "--rate-limit: "),
        ("--band", ("1 Hz", "5 V"), "--band: "),
        ("--normalise-at", ("2",), "--normalise-at: "),
    ],
)
def test_a_number_of_an_import_is_refused_under_the_name_of_its_option(refused, option, value, words):
    said = refused("import", "m.mat", *IMPORT, option, *value)
    wrong = next(each for each in value if each not in ("0 V", "12 V", "1 Hz"))
    assert said.startswith(f"microrad: {words}") and f'"{wrong}"' in said


@pytest.mark.parametrize(
    ("given", "folder_name", "name", "precision", "flags"),
    [
        ((), "leo-geo-pi_inverse", "pi_inverse", "double", (False, False)),
        (("--precision", "fixed", "--accept"), "leo-geo-pi_inverse", "pi_inverse", "fixed", (False, True)),
        (("--name", "fsm", "--overwrite"), "leo-geo-fsm", "fsm", "double", (True, False)),
        (("--output", "a b", "--precision", "single"), "a b", "pi_inverse", "single", (False, False)),
    ],
)
def test_code_is_written_as_it_is_asked_for(mission, call, monkeypatch, given, folder_name, name, precision, flags):
    asked = []

    def exported(chosen, folder, **more):
        asked.append((chosen, str(folder), more))
        return "found"

    monkeypatch.setattr(cli_export, "_chosen", lambda mission, several, wanted, progress: wanted)
    monkeypatch.setattr(write, "export_flight", exported)
    monkeypatch.setattr(write, "report_text", lambda found: f"{found} in words")
    monkeypatch.setattr(write, "export_data", lambda found: {"data": found})
    monkeypatch.setattr(write, "check_output", lambda *given: asked.append(given))
    file = mission / "leo-geo.toml"
    result = call("export", "c", file, *given)
    (checked, overwrite), (chosen, folder, more) = asked
    more.pop("on_progress")
    assert (str(checked), overwrite, chosen, folder) == (folder_name, flags[0], "PI + inverse", folder_name)
    assert more == {"name": name, "precision": precision, "overwrite": flags[0], "accept": flags[1]}
    assert result.out == f"found in words\n\n{folder}\n"
    assert json.loads(call("export", "c", file, *given, "--json").out) == {"data": "found", "folder": folder}


# ------------------------------------------------------------------------------------------- one option beside another
@pytest.mark.parametrize(
    ("given", "of", "path"),
    [
        ((), ("source", "axes"), "my day.mat"),
        (("--controller", "LQG", "--accept"), ("LQG", "axes", True), "my day.mat"),
        (("--controller", "PI", "--output", "x.mat", "--overwrite"), ("PI", "axes", False), "x.mat"),
    ],
)
def test_matrices_are_of_the_mirror_or_of_a_controller_and_go_where_they_are_asked_to(
    call, refused, folder, loaded, monkeypatch, given, of, path
):
    written = []
    loaded("loop", "axes")
    monkeypatch.setattr(choice, "source", lambda mission, several: ("source", several))
    monkeypatch.setattr(
        cli_export, "_promised", lambda mission, several, name, accept, progress: (name, several, accept)
    )
    monkeypatch.setattr(linear, "models", lambda of: [SimpleNamespace(name="mirror of"), SimpleNamespace(name=str(of))])
    monkeypatch.setattr(linear, "write_mat", lambda found, path: written.append((found[1].name, str(path))))
    monkeypatch.setattr(linear, "json_text", lambda found: f"[{found[1].name}]")
    if "--overwrite" in given:
        (folder / path).write_bytes(b"MATLAB 5.0 MAT")
    assert call("export", "matrices", "some/my day.toml", *given) == (0, f"{path} written: mirror of, {of}\n", "")
    (folder / path).write_bytes(b"MATLAB 4")
    assert call("export", "matrices", "some/my day.toml", *given, "--json") == (0, f"[{of}]\n", "")
    assert written == [(str(of), path)]
    said = refused("export", "matrices", "some/my day.toml", *given)
    kept = "was not written by microrad" if "--overwrite" in given else "exists"
    replace = "" if "--overwrite" in given else ", or replace it with --overwrite"
    assert said == f"microrad: {path} {kept} and is left as it is; choose another --output{replace}.\n"


@pytest.mark.parametrize("begins", [b"PK\x03\x04", b"P", b"#!"])
def test_a_unit_of_a_version_replaces_another_unit_alone(call, refused, folder, loaded, monkeypatch, begins):
    written = []
    loaded("loop", "axes")
    monkeypatch.setattr(choice, "plant_unit", lambda mission, table, several: (table, several))
    monkeypatch.setattr(fmu, "write_unit", lambda *args: written.append(args) or SimpleNamespace(words="a unit"))
    (folder / "u.fmu").write_bytes(begins)
    given = ("export", "fmu", "day.toml", "--fmi", "3.0", "--output", "u.fmu")
    exists = "microrad: u.fmu exists and is left as it is; choose another --output, or replace it with --overwrite.\n"
    assert refused(*given) == exists
    if begins != b"PK\x03\x04":
        assert "u.fmu was not written by microrad" in refused(*given, "--overwrite") and not written
        return
    assert call(*given, "--overwrite") == (0, "a unit\n", "")
    ((unit, path, version, name),) = written
    assert (unit, str(path), version, name) == (("fine_pointing", "axes"), "u.fmu", "3.0", "mirror")


def test_a_controller_is_chosen_with_its_mirror_before_it_is_held_to_its_promise(monkeypatch):
    steps = []
    monkeypatch.setattr(cli_export, "_chosen", lambda *given: steps.append(given) or "chosen")
    monkeypatch.setattr(choice, "promised", lambda *given: steps.append(given))
    assert cli_export._promised("mission", "axes", "LQG", True, "progress") == "chosen"
    assert steps == [("mission", "axes", "LQG", "progress"), ("chosen", True)]


@pytest.mark.parametrize("several", [None, "table"])
def test_a_mirror_of_several_axes_is_that_of_the_loop(monkeypatch, several):
    asked = []
    monkeypatch.setattr("microrad.mission.file.load_loop", lambda *given: asked.append(given) or ("mission", several))
    monkeypatch.setattr("microrad.mirror.coupled.of", lambda table: f"mirror of the {table}")
    found = cli_export._loaded("m.toml", "mirror.toml")
    assert found == ("mission", several and "mirror of the table") and asked == [("m.toml", "mirror.toml")]


@pytest.mark.parametrize(("name", "words"), [("2fast", "2fast"), ("a b", "a b"), ("", ""), ("int", "int")])
@pytest.mark.parametrize("command", ["c", "fmu"])
def test_a_name_that_no_code_can_have_is_refused_before_anything_is_designed(
    refused, folder, loaded, monkeypatch, command, name, words
):
    loaded("loop")
    monkeypatch.setattr(cli_export, "_chosen", lambda *given: pytest.fail("it was designed"))
    assert words in refused("export", command, "day.toml", "--name", name)


def test_an_imported_mirror_that_cannot_be_read_leaves_the_one_that_is_there(refused, folder):
    (folder / "m-mirror.toml").write_text("# Mirror imported before", "utf-8")
    said = refused("import", "sub/m.mat", *IMPORT)
    where = "m-mirror.toml exists and is left as it is; choose another --output, or replace it with --overwrite."
    assert said == f"microrad: {where}\n"
    assert "sub/m.mat" in refused("import", "sub/m.mat", *IMPORT, "--overwrite")


def test_a_mirror_is_sought_from_the_folder_of_work(monkeypatch):
    asked = []
    monkeypatch.setattr("microrad.mission.file.load_loop", lambda *files: asked.append(files) or ("mission", None))
    assert cli_export._loaded(Path("days/day.toml"), Path("mine/mirror.toml")) == ("mission", None)
    assert cli_export._loaded(Path("days/day.toml"), None) == ("mission", None)
    assert asked == [(Path("days/day.toml"), Path("mine/mirror.toml")), (Path("days/day.toml"), None)]


@pytest.mark.parametrize(
    ("command", "taken"),
    [("c", "day-pi_inverse"), ("fmu", "day-mirror.fmu"), ("matrices", "day.mat")],
)
@pytest.mark.parametrize("overwrite", [(), ("--overwrite",)])
def test_what_must_stay_is_refused_before_anything_is_designed(
    refused, folder, loaded, monkeypatch, command, taken, overwrite
):
    loaded("loop")
    for name in ("choose", "choose_coupled", "plant_unit", "source"):
        monkeypatch.setattr(choice, name, lambda *given: pytest.fail("it was designed"))
    (folder / taken).mkdir()
    (folder / taken / "thesis.txt").write_text("mine", encoding="utf-8")
    said = refused("export", command, "sub/day.toml", *overwrite)
    assert said.startswith(f"microrad: {taken}")


@pytest.mark.parametrize("command", ["c", "fmu", "matrices"])
def test_a_folder_that_is_not_there_is_told_and_a_mission_that_cannot_be_read_too(refused, folder, command):
    assert "nowhere.toml" in refused("export", command, "nowhere.toml", "--output", "x")
    (folder / "broken.toml").write_text("[mirror\n", encoding="utf-8")
    assert "broken.toml" in refused("export", command, "broken.toml", "--output", "x")


@pytest.mark.parametrize(("accept", "as_json"), [((), ()), (("--accept",), ("--json",))])
def test_a_controller_of_matrices_and_of_a_unit_is_held_to_its_promise(
    call, refused, folder, loaded, monkeypatch, accept, as_json
):
    asked = []

    def promised(chosen, accepted):
        asked.append((chosen, accepted))
        if not accepted:
            raise ExportError("m.toml: it leaves too much")

    loaded("loop", "axes")
    monkeypatch.setattr(cli_export, "_chosen", lambda mission, several, name, progress: (name, several))
    monkeypatch.setattr(choice, "promised", promised)
    monkeypatch.setattr(choice, "loop_unit", lambda chosen: chosen)
    monkeypatch.setattr(linear, "models", lambda of: [SimpleNamespace(name=str(of))])
    monkeypatch.setattr(linear, "json_text", lambda found: found[0].name)
    monkeypatch.setattr(fmu, "write_unit", lambda unit, *more: SimpleNamespace(words=f"unit of {unit}"))
    for command, form, out in (("matrices", as_json, "{}"), ("fmu", (), "unit of {}")):
        given = ("export", command, "day.toml", "--controller", "LQG", *accept, *form)
        if accept:
            assert call(*given) == (0, f"{out.format(('LQG', 'axes'))}\n", "")
        else:
            assert refused(*given) == "microrad: m.toml: it leaves too much (see docs/export.md)\n"
    assert asked == [(("LQG", "axes"), bool(accept))] * 2
