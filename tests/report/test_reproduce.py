"""A report run again from the manifest that it carries: what differs, and what is refused."""

import dataclasses
import hashlib
import json
import math
import platform
import re
import shutil
from pathlib import Path
from types import SimpleNamespace

import pytest

from microrad import cli, report
from microrad.core import machine
from microrad.mission import file as missionfile
from microrad.report.results import arrays, manifest, manifest_reader, reproduce, tolerances
from microrad.report.results import comparison as compared
from microrad.report.results.manifest import with_manifest
from microrad.report.results.reproduce import reproduction_data
from microrad.report.study import page
from microrad.study import study
from shipped import SHIPPED, edited_file, without_fine_pointing


@pytest.fixture(scope="module", autouse=True)
def no_scan():
    """The scan has tests of its own and takes the longest."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(study.paper, "applies", lambda mission: False)
        yield


@pytest.fixture(scope="module")
def ran(tmp_path_factory):
    """A study of little: a quarter of a day, one sine of each controller and a loop, none of them slow."""
    return study.run_study(
        edited_file(
            tmp_path_factory.mktemp("mission"),
            ("runs = 4000 ", "runs = 100 "),
            ('duration = "24 h"', 'duration = "6 h"'),
            ('pid_frequencies = ["1 Hz", "15 Hz"]', 'pid_frequencies = ["15 Hz"]'),
            ('inverse_frequencies = ["15 Hz", "25 Hz"]', 'inverse_frequencies = ["25 Hz"]'),
            ('loop_frequencies = ["1 Hz", "60 Hz", "80 Hz", "100 Hz"]', 'loop_frequencies = ["100 Hz"]'),
        )
    )


@pytest.fixture(scope="module")
def written(ran, tmp_path_factory):
    target = tmp_path_factory.mktemp("report") / "study"
    report.write(ran, target)
    return target


@pytest.fixture
def not_run(monkeypatch, ran, written):
    """The study and its report as they were, without the time that they take."""
    monkeypatch.setattr(reproduce.study, "run_study", lambda file, on_progress: ran)

    def copied(found, target, **settings):
        shutil.copytree(written, target)
        return target / "report.html"

    monkeypatch.setattr(report, "write", copied)


def manifest_of(folder):
    return json.loads((folder / "manifest.json").read_text(encoding="utf-8"))


@pytest.fixture
def changed(written, tmp_path):
    """The report with its manifest edited, as a file of its own; the hash of its summary is stated anew."""

    def edit(change, restated=True):
        found = manifest_reader.read_manifest(written / "report.html")
        data = json.loads(json.dumps(found.data))
        change(data)
        if restated and isinstance(data["summary"], dict):
            data["summary_sha256"] = manifest_reader.hash_of_summary(data["summary"])
        path = tmp_path / "changed.html"
        path.write_text(with_manifest(found.page, page.embedded(data)), encoding="utf-8")
        return path

    return edit


def elsewhere(data):
    """The manifest as another processor would have written it."""
    data["machine"]["processor"] = "another"


def call(capsys, *args):
    with pytest.raises(SystemExit) as ended:
        cli.app(["reproduce", *map(str, args)])
    out, err = capsys.readouterr()
    return ended.value.code, out, err


# ---------------------------------------------------------------------------------------------------------------- same
@pytest.mark.promise("decisions-1", "report-1", "report-3", "report-14", "report-15")
def test_the_same_inputs_give_nothing_that_differs(written, capsys):
    code, out, _ = call(capsys, written / "report.html", "--json")
    found = json.loads(out)
    assert (code, found["same"]) == (0, True)
    assert found["largest_relative_difference"] == 0.0
    assert found["numbers"] > 500
    assert found["differences"] == found["altered"] == found["figure_data"] == found["page"] == []
    assert (found["layout"], found["machine_and_versions"]) == (False, {})
    assert found["compared"] == "to the last bit"


@pytest.mark.promise("readme-5", "report-14", "report-21")
@pytest.mark.parametrize("name", ["", "manifest.json"])
@pytest.mark.promise("readme-23")
def test_a_folder_or_its_manifest_will_do(not_run, written, capsys, name):
    code, out, _ = call(capsys, written / name)
    assert code == 0
    assert "nothing differs (" in out
    assert "Same machine and versions: compared to the last bit." in out


@pytest.mark.promise("report-2")
def test_the_page_and_the_manifest_beside_it_carry_the_same(written, ran):
    inside, beside = manifest_reader.read_manifest(written / "report.html").data, manifest_of(written)
    hashes = [each.pop("files_sha256") for each in (inside, beside)]
    assert inside.pop("page_sha256") == manifest_reader.hash_of_page(
        (written / "report.html").read_text(encoding="utf-8")
    )
    assert inside == beside
    assert inside["mission"]["text"] == ran.file.text
    assert set(hashes[1]) - set(hashes[0]) >= {"report.html", "results.nc"}
    assert {k: v for k, v in hashes[1].items() if k in hashes[0]} == hashes[0]


# -------------------------------------------------------------------------------------------------------------- changed
@pytest.mark.promise("report-20", "report-21")
def test_a_changed_aperture_is_told_with_what_follows(changed, capsys, monkeypatch):
    monkeypatch.setattr(report, "study_figures", lambda *args: page.StudyFigures())
    monkeypatch.setattr(arrays, "study_netcdf", lambda study: b"")  # of its files the page and the summary are read

    def wider(data):
        text = data["mission"]["text"]
        assert text.count('leo_aperture = "5 cm"') == 1
        data["mission"]["text"] = text.replace('leo_aperture = "5 cm"', 'leo_aperture = "6 cm"')

    code, out, _ = call(capsys, changed(wider))
    assert code == 1
    assert "the report is not reproduced" in out
    assert "the mission's text was changed after the report was written" in out
    margin = r"margin_db\.communication_as_budgeted: was 3\.00\d+ and is 3\.\d+, relative difference 0\.\d+"
    assert re.search(margin, out)
    assert "mission_sha256: was" in out


def test_a_changed_number_is_told_with_its_size(not_run, changed, capsys):
    def more(data):
        data["summary"]["margin_db"]["beacon"] *= 1.001

    path = changed(more)
    found = reproduce.reproduce(path)
    assert [each.place for each in found.differences] == ["margin_db.beacon"]
    assert found.differences[0].relative == pytest.approx(0.001 / 1.001, rel=1e-9)
    assert found.largest == found.differences[0].relative
    assert found.page == found.files == found.altered == ()
    code, out, _ = call(capsys, path)
    assert code == 1
    assert "the report is not reproduced (" in out
    assert "1 differs." in out
    assert "margin_db.beacon: was 6.30" in out


@pytest.mark.promise("report-15")
def test_a_verdict_turned_round_is_told(not_run, changed):
    def pass_all(data):
        for each in data["summary"]["requirements"]:
            each["met"] = True

    found = reproduce.reproduce(changed(pass_all))
    assert [(d.place, d.was, d.now) for d in found.differences] == [
        ("requirements[3].met", True, False),
        ("requirements[4].met", True, False),
    ]


# --------------------------------------------------------------------------------------- here, and on another machine
def last_bit(data):
    beacon = data["summary"]["margin_db"]["beacon"]
    data["summary"]["margin_db"]["beacon"] = math.nextafter(beacon, math.inf)


@pytest.mark.promise("report-15", "report-16")
def test_the_last_bit_counts_on_the_same_machine_alone(not_run, changed, capsys):
    code, out, _ = call(capsys, changed(last_bit))
    assert code == 1
    assert "Same machine and versions: compared to the last bit." in out
    assert re.search(
        r"margin_db\.beacon: was (6\.30\d{10,}) and is (?!\1)6\.30\d{10,}, relative difference 1\.\de-16", out
    )
    code, out, _ = call(capsys, changed(lambda data: (last_bit(data), elsewhere(data))))
    assert code == 0
    assert "the numbers agree (" in out
    assert re.search(r"other versions: compared to stated tolerances \(processor was another and is \S+\)\.", out)


@pytest.mark.promise("report-16")
@pytest.mark.parametrize(
    "change",
    [
        lambda data: data["machine"].update({"instruction sets": "SSE"}),
        lambda data: data["machine"].update(OPENBLAS_CORETYPE="another one"),
        lambda data: data["machine"].pop("processor"),
        lambda data: data["versions"].update(numpy="0.1"),
        lambda data: data.pop("machine"),
    ],
    ids=["instruction sets", "OPENBLAS_CORETYPE", "processor", "numpy", "nothing said"],
)
def test_whatever_changes_arithmetic_makes_another_machine(not_run, changed, change):
    found = reproduce.reproduce(changed(lambda data: (last_bit(data), change(data))))
    assert (found.to_the_last_bit, found.same) == (False, True)
    assert set(found.unlike) <= {*machine.machine(), "OPENBLAS_CORETYPE", "numpy"}


@pytest.mark.promise("report-16")
def test_a_machine_that_is_said_by_its_architecture_alone_is_another(not_run, changed, capsys):
    code, out, _ = call(capsys, changed(lambda data: (last_bit(data), data.update(machine="x86_64"))))
    assert code == 0
    assert "of its machine the report says no more than x86_64, as version 0.1.0 wrote it" in out
    assert "was none" not in out


@pytest.mark.promise("report-4", "report-16")
def test_the_machine_says_what_changes_arithmetic(monkeypatch):
    monkeypatch.delenv("OPENBLAS_CORETYPE", raising=False)
    before = machine.machine()
    monkeypatch.setenv("OPENBLAS_CORETYPE", "Prescott")
    monkeypatch.setenv("NUMBA_CPU_NAME", "generic")
    assert machine.machine() == {**before, "OPENBLAS_CORETYPE": "Prescott", "NUMBA_CPU_NAME": "generic"}
    assert all(before[name] for name in ("processor", "instruction sets", "C library", "numpy's BLAS", "scipy's BLAS"))


@pytest.mark.promise("report-16")
def test_neither_machine_nor_manifest_say_whose_it_is(monkeypatch, ran, written):
    monkeypatch.setattr(platform, "node", lambda: "secret-host")
    for name in ("HOSTNAME", "USER", "LOGNAME", "HOME"):
        monkeypatch.setenv(name, "secret-user")
    assert "secret" not in " ".join(machine.machine().values())
    made = manifest.manifest_of(ran, report.summary(ran), written)
    assert made["machine"] == machine.machine() and "secret" not in json.dumps(made)
    assert str(written.parent) not in json.dumps(made)


# --------------------------------------------------------------------------------------- altered, or drawn differently
@pytest.mark.promise("report-20")
def test_a_number_changed_on_the_page_alone_is_told(not_run, written, tmp_path, capsys):
    text = (written / "report.html").read_text(encoding="utf-8")
    assert text.count(">residual pointing error</td>") == 1
    path = tmp_path / "report.html"
    path.write_text(text.replace(">residual pointing error</td>", ">other pointing error</td>"), encoding="utf-8")
    code, out, _ = call(capsys, path)
    assert code == 1
    assert "it was changed after it was written" in out
    assert "its page was changed after the report was written" in out
    assert "the page's text is not what this run writes: line " in out
    assert "other pointing error" in out


@pytest.mark.promise("report-20")
def test_a_summary_changed_within_its_tolerance_is_told(not_run, changed):
    def little(data):
        elsewhere(data)
        last_bit(data)

    found = reproduce.reproduce(changed(little, restated=False))
    assert found.differences == ()
    assert [text.partition(" was")[0] for text in found.altered] == ["its summary"]
    assert not found.same


@pytest.fixture
def copy(written, tmp_path):
    return shutil.copytree(written, tmp_path / "copy")


def rewritten(folder, name, old, new):
    """A file of a folder of results with other text, and the page and the manifest as if it had been written so."""
    path = folder / name
    text = path.read_text(encoding="utf-8")
    assert text.count(old)
    path.write_text(text.replace(old, new, 1), encoding="utf-8", newline="")
    data = manifest_of(folder)
    data["files_sha256"][name] = hashlib.sha256(path.read_bytes()).hexdigest()
    return folder, data


@pytest.mark.promise("report-20")
@pytest.mark.parametrize("name", ["report.html", "figures/tornado.csv", "results.nc"])
def test_a_file_beside_a_manifest_that_was_changed_is_told(not_run, copy, capsys, name):
    with (copy / name).open("ab") as file:
        file.write(b"\n")
    code, out, _ = call(capsys, copy)
    assert code == 1
    assert f"{name} beside it was changed after the report was written" in out


@pytest.mark.promise("report-19")
def test_another_layout_and_other_words_of_the_page_leave_the_numbers_agreeing(not_run, written, tmp_path, capsys):
    found = manifest_reader.read_manifest(written / "report.html")

    def of_another_version(old, new):
        text = found.page.replace(old, new)
        assert text != found.page
        text = with_manifest(text, page.embedded({**found.data, "page_sha256": manifest_reader.hash_of_page(text)}))
        path = tmp_path / "report.html"
        path.write_text(text, encoding="utf-8")
        return call(capsys, path)[:2]

    code, out = of_another_version("<h3>", '<h3 class="new">')
    assert code == 0
    assert "the numbers agree (" in out
    assert "other than this run's: the page's layout." in out
    assert "the page's layout or drawings are not what this run writes; its text is" in out
    code, out = of_another_version("Not in this study", "Left out of this study")
    assert code == 0
    assert "other than this run's: the page's text." in out
    assert "Left out of this study" in out


@pytest.mark.promise("report-14", "report-15")
def test_figure_data_beside_the_report_are_compared_as_numbers(not_run, copy, changed, capsys):
    name = "figures/tornado.csv"
    first = (copy / name).read_text(encoding="utf-8").splitlines()[1].split(",")[2]

    def with_first(value, machine="here"):
        shutil.copyfile(copy / name, copy / "kept")
        folder, data = rewritten(copy, name, first, value)
        if machine == "elsewhere":
            elsewhere(data)
        (folder / "manifest.json").write_text(json.dumps(data), encoding="utf-8")
        (folder / "report.html").unlink(missing_ok=True)  # its own manifest states the hash that the data had
        found = reproduce.reproduce(folder)
        shutil.move(copy / "kept", copy / name)
        return found

    near, far = f"{float(first) + 2e-8:.9g}", f"{float(first) + 2e-6:.9g}"
    here = with_first(near)
    assert [d.place for d in here.differences] == [f"{name}: margin lower (dB), row 1"]
    assert here.read == here.files == (name,)
    assert with_first(near, "elsewhere").same
    there = with_first(far, "elsewhere")
    assert [d.place for d in there.differences] == [f"{name}: margin lower (dB), row 1"]


@pytest.mark.promise("report-19")
def test_figure_data_that_do_not_stand_beside_the_report_are_told(not_run, changed, capsys):
    def other(data):
        data["files_sha256"]["figures/fig6-pid.csv"] = "0" * 64
        data["files_sha256"]["figures/fig6-pid.svg"] = "0" * 64  # drawn, not data

    code, out, _ = call(capsys, changed(other))
    assert code == 0
    assert "the numbers agree (" in out
    assert "other than this run's: data of figures." in out
    assert "not byte for byte the same: figures/fig6-pid.csv; their numbers are not compared" in out


@pytest.mark.promise("report-14")
def test_a_file_that_the_mission_names_is_carried_up_to_a_megabyte():
    named = {
        "a.csv": b"x" * manifest.MOST_INPUT_BYTES,
        "b.csv": b"x" * (manifest.MOST_INPUT_BYTES + 1),
        "c.png": b"\xff",
    }
    assert [*manifest._input_texts(named)] == ["a.csv"]
    assert manifest.MOST_INPUT_BYTES == 1_000_000


@pytest.mark.promise("report-19")
def test_curves_are_not_compared_elsewhere(not_run, copy):
    name = "figures/latency.csv"
    head = (copy / name).read_text(encoding="utf-8").partition("\n")[0]
    folder, data = rewritten(copy, name, head, f"{head}\n0.25,0.5,0.25,0.5")
    (folder / "report.html").unlink()

    def found(change):
        change(data)
        (folder / "manifest.json").write_text(json.dumps(data), encoding="utf-8")
        return reproduce.reproduce(folder)

    here, there = found(lambda data: None), found(elsewhere)
    assert (here.read, here.same) == ((name,), False)
    assert (there.files, there.read, there.same) == ((name,), (), True)


@pytest.mark.promise("report-20")
def test_a_report_without_hashes_of_its_page_and_summary_is_held_against_what_it_has(not_run, written, tmp_path):
    found = manifest_reader.read_manifest(written / "report.html")
    data = {key: value for key, value in found.data.items() if key not in ("page_sha256", "summary_sha256")}
    path = tmp_path / "report.html"
    path.write_text(
        with_manifest(found.page.replace("<h3>", '<h3 class="new">'), page.embedded(data)), encoding="utf-8"
    )
    again = reproduce.reproduce(path)
    assert (again.altered, again.same, again.layout) == ((), True, True)


def test_a_file_with_other_line_ends_is_not_called_changed(tmp_path):
    text = without_fine_pointing(SHIPPED.read_text(encoding="utf-8"))
    path = tmp_path / "mission.toml"
    path.write_bytes(b"\xef\xbb\xbf" + text.replace("\n", "\r\n").encode())
    file = missionfile.load_mission(path)
    data = {"mission": report_entry(file), "summary": {}}
    held = manifest_reader.ReadManifest(path, data, "")
    assert manifest_reader.altered_parts(held) == ()
    again, moved = manifest_reader.unpack_mission(held, tmp_path / "again")
    assert again.sha256 == file.sha256 == hashlib.sha256(path.read_bytes()).hexdigest()
    assert (again.mission, moved) == (file.mission, {})


def report_entry(file, **changes):
    """A mission as the manifest has it."""
    digest = hashlib.sha256(file.text.encode()).hexdigest()
    return {"file": file.path.name, "sha256": file.sha256, "text_sha256": digest, "text": file.text, **changes}


# -------------------------------------------------------------------------------------------------------------- refused
def cut(where):
    def text(whole):
        return whole[: whole.index(where) + len(where)]

    return text


OPENING = manifest_reader.OPENING
REFUSED = {
    "cut before its manifest": (cut("The paper against"[:9]), "carries no manifest: it was cut short"),
    "cut within its manifest": (cut(OPENING + '{"mission"'), "ends within its manifest: it was cut short"),
    "no report": (lambda whole: "<html><body>holiday</body></html>", "is no report of microrad; name a report.html"),
    "empty": (lambda whole: "", "is no report of microrad"),
    "two manifests": (lambda whole: whole + OPENING + "{}</script>", "carries 2 manifests"),
    "no JSON": (lambda whole: OPENING + "{nonsense</script>", "its manifest is no JSON"),
    "no number": (lambda whole: OPENING + '{"a": NaN}</script>', "NaN is no number of JSON"),
    "nested": (lambda whole: OPENING + "[" * 100_000 + "</script>", "its manifest is nested too deeply"),
    "a list": (lambda whole: OPENING + "[]</script>", "has no mission with file, sha256, text"),
    "of a campaign": (lambda whole: OPENING + '{"campaign": {}}</script>', "none of a study of this version"),
}


@pytest.mark.promise("report-21")
@pytest.mark.parametrize("case", REFUSED)
def test_what_is_no_whole_report_is_refused_in_words(written, tmp_path, capsys, case):
    make, words = REFUSED[case]
    path = tmp_path / "report.html"
    path.write_text(make((written / "report.html").read_text(encoding="utf-8")), encoding="utf-8")
    code, out, err = call(capsys, path)
    assert (code, out) == (2, "")
    assert words in err
    assert err.startswith("microrad: ")
    assert len(err) < 500


@pytest.mark.promise("report-21")
def test_what_is_no_text_or_not_there_is_refused_in_words(tmp_path, capsys):
    (tmp_path / "image.html").write_bytes(b"\x89PNG\xff\xfe")
    assert "is no text, so no report of microrad" in call(capsys, tmp_path / "image.html")[2]
    assert "there is no such file" in call(capsys, tmp_path / "absent.html")[2]
    assert "there is no such file" in call(capsys, tmp_path)[2]  # a folder without a manifest


def test_a_huge_report_is_refused_before_it_is_read(tmp_path, monkeypatch):
    path = tmp_path / "report.html"
    with path.open("wb") as file:
        file.truncate(manifest_reader.MOST_BYTES + 1)
    monkeypatch.setattr(type(path), "read_bytes", lambda self: pytest.fail("read"))
    with pytest.raises(reproduce.ReproduceError, match=r"is 64 MB long; a report of microrad has at most 64 MB"):
        manifest_reader.read_manifest(path)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"mission": {"file": "m.toml", "sha256": "0", "text": 3, "text_sha256": "0"}}, "no mission with file"),
        ({"mirror": ["mirror.toml"]}, "no mirror with file, sha256, text, text_sha256"),
        ({"inputs": {"a": 3}}, "no inputs as names with texts"),
        ({"inputs": {str(i): "" for i in range(17)}}, "more inputs than a mission names"),
        ({"inputs": {"a": "x" * 4_000_001}}, "more inputs than a mission names"),
        ({"versions": 3}, "no versions as names with texts"),
        ({"machine": {"processor": 3}}, "no machine as names with texts"),
        ({"machine": 3}, "no machine as names with texts"),
        ({"summary": None}, "no summary, against which a run could be held"),
    ],
)
def test_values_of_another_kind_are_refused_in_words(changed, change, words):
    with pytest.raises(reproduce.ReproduceError, match=words):
        manifest_reader.read_manifest(changed(lambda data: data.update(change)))


def test_a_file_of_the_greatest_length_is_read(tmp_path, monkeypatch):
    path = tmp_path / "manifest.json"
    path.write_text("{}   ", encoding="utf-8")
    monkeypatch.setattr(manifest_reader, "MOST_BYTES", 5)
    with pytest.raises(reproduce.ReproduceError, match="has no mission with file"):
        manifest_reader.read_manifest(path)
    monkeypatch.setattr(manifest_reader, "MOST_BYTES", 4)
    with pytest.raises(reproduce.ReproduceError, match="a report of microrad has at most 0 MB"):
        manifest_reader.read_manifest(path)


def test_a_folder_in_place_of_the_manifest_is_refused_in_words(tmp_path):
    (tmp_path / "manifest.json").mkdir()
    with pytest.raises(reproduce.ReproduceError, match=r"is a folder without a manifest\.json; name a report\.html or"):
        manifest_reader.read_manifest(tmp_path)


def test_a_whole_number_has_at_most_18_digits_and_then_is_a_float():
    found = manifest_reader._parsed("m.json", f"[{'9' * 18}, {'9' * 19}, -{'9' * 17}]")
    assert [(type(each), each) for each in found] == [(int, 10**18 - 1), (float, 1e19), (int, 1 - 10**17)]


def held(**data):
    """A manifest with the least that is read."""
    entry = {"file": "m.toml", "sha256": "0", "text": "", "text_sha256": hashlib.sha256(b"").hexdigest()}
    return {"mission": entry, "versions": {}, "summary": {}, **data}


@pytest.mark.parametrize(
    "data",
    [
        {"inputs": {str(i): "" for i in range(manifest_reader.MOST_FILES)}},
        {"inputs": {"a": "x" * 12, "b": "x" * 8}},
        {"mission": {**held()["mission"], "text": "x" * 20}},
        {"mirror": None},
        {"machine": "x86_64"},
        {"versions": {str(i): "x" * 20 for i in range(30)}},
    ],
    ids=["files", "their length", "mission", "no mirror", "architecture", "versions"],
)
def test_as_much_as_a_manifest_may_have_is_read(tmp_path, monkeypatch, data):
    monkeypatch.setattr(manifest_reader, "MOST_TEXT", 20)
    path = tmp_path / "manifest.json"
    path.write_text(json.dumps(held(**data)), encoding="utf-8")
    assert manifest_reader.read_manifest(path).data == held(**data)


def test_several_faults_of_a_manifest_are_told_together(tmp_path):
    path = tmp_path / "manifest.json"
    path.write_text(json.dumps(held(summary=3, versions=3, files_sha256=[])), encoding="utf-8")
    said = "no versions as names with texts; no files_sha256 as names with texts; no summary, against which"
    with pytest.raises(reproduce.ReproduceError, match=said):
        manifest_reader.read_manifest(path)


def test_what_was_changed_is_told_part_by_part(tmp_path):
    """The mission's text, the mirror's, that of a file, the summary; what is as it was is not told."""
    entry = held()["mission"]
    data = held(
        mission={**entry, "text": "changed"},
        mirror={**entry, "text": "changed"},
        inputs={"a.csv": "", "b.csv": "changed", "c.csv": "never stated"},
        inputs_sha256={"a.csv": entry["text_sha256"], "b.csv": entry["text_sha256"]},
        summary_sha256=manifest_reader.hash_of_summary({"a": 1.0}),
    )
    found = manifest_reader.altered_parts(manifest_reader.ReadManifest(tmp_path / "manifest.json", data, ""))
    parts = ["the mission's text", "the mirror file's text", "the text of b.csv", "the text of c.csv", "its summary"]
    assert [text.partition(" was changed after")[0] for text in found] == parts
    own = hashlib.sha256(b"changed").hexdigest()[:16]
    assert found[0].endswith(f"its SHA-256 is {own}…, and {entry['text_sha256'][:16]}… is stated")
    same = manifest_reader.ReadManifest(tmp_path / "manifest.json", held(), "")
    assert (manifest_reader.altered_parts(same), same.named) == ((), {})


def test_a_file_beside_the_report_is_read_up_to_the_greatest_length_and_inside_its_folder(tmp_path, monkeypatch):
    folder = tmp_path / "folder"
    folder.mkdir()
    (folder / "a.csv").write_bytes(b"12345")
    (tmp_path / "outside.csv").write_bytes(b"1")
    at = manifest_reader.ReadManifest(folder / "manifest.json", held(), "")
    monkeypatch.setattr(manifest_reader, "MOST_BYTES", 5)
    assert manifest_reader.content_beside(at, "a.csv") == b"12345"
    assert manifest_reader.content_beside(at, "../outside.csv") is None
    assert manifest_reader.content_beside(at, "absent.csv") is None
    monkeypatch.setattr(manifest_reader, "MOST_BYTES", 4)
    assert manifest_reader.content_beside(at, "a.csv") is None


def test_a_text_that_is_too_long_is_refused(changed, monkeypatch):
    monkeypatch.setattr(manifest_reader, "MOST_TEXT", 1000)
    with pytest.raises(reproduce.ReproduceError, match=r"a mission text of \d+ characters"):
        manifest_reader.read_manifest(changed(lambda data: None))


def test_a_mission_that_is_none_is_refused_by_its_faults(changed, capsys):
    code, _, err = call(capsys, changed(lambda data: data["mission"].update(text="name = 3\nname = [")))
    assert code == 2
    assert "fault" in err
    assert "name" in err


def test_a_mission_that_does_not_run_is_refused_in_words(changed, capsys):
    def unstable(data):
        text = data["mission"]["text"]
        data["mission"]["text"] = text.replace('integral = "16000 V/(mrad s)"', 'integral = "1e9 V/(mrad s)"')

    code, _, err = call(capsys, changed(unstable))
    assert code == 2
    assert "the mission that it carries does not run: " in err


# -------------------------------------------------------------------------------------------------------------- hostile
def test_a_text_with_markup_stays_text(tmp_path, ran):
    text = ran.file.text + "\n# </script><script>alert(1)</script> & <!--\n"
    data = {"mission": report_entry(ran.file, text=text)}
    embedded = page.embedded(data)
    assert not set("<>&") & set(embedded)
    assert json.loads(embedded)["mission"]["text"] == text


EVIL = (
    "../evil.txt",
    "../../evil.txt",
    "a/../../evil.txt",
    "/tmp/microrad-evil.txt",
    "..",
    ".",
    "",
    "..\\evil.txt",
    "C:\\evil.txt",
    "a\0b",
    "\udc80.txt",
    ".bashrc",
    "x" * 300,
    "a/b/c/d/e/f.txt",
)


@pytest.mark.parametrize("name", EVIL)
def test_no_name_leads_out_of_the_folder(tmp_path, name):
    """Of the mission's file, of its mirror's and of a file that it names."""
    text = SHIPPED.read_text(encoding="utf-8")
    olympus = re.search(r'(?m)^spectrum = "olympus".*\n', text)[0]
    quoted = json.dumps(name) if name.isprintable() and 0 < len(name) < 200 else '"spectrum.csv"'
    text = text.replace(olympus, f'spectrum = "table"\nfile = {quoted}\n')
    begin, end = text.index("[mirror]\n"), text.index("[amplifier]\n")
    mirror = text[begin + len("[mirror]\n") : end].replace("[mirror.", "[")
    text = text[:begin] + '[mirror]\nfile = "/etc/hostname"\n\n' + text[end:]
    entry = {"file": name, "sha256": "0", "text_sha256": "0"}
    named = json.loads(quoted)
    data = {
        "mission": {**entry, "text": text},
        "mirror": {**entry, "text": mirror},
        "inputs": {named: "Hz, urad^2/Hz\n1, 1\n", name: "evil"} if name != named else {named: "Hz\n"},
    }
    inside = tmp_path / "a" / "b" / "inside"
    inside.parent.mkdir(parents=True)
    before = set(tmp_path.parent.iterdir())
    file, moved = manifest_reader.unpack_mission(
        manifest_reader.ReadManifest(tmp_path / "report.html", data, ""), inside
    )
    found = [path for path in tmp_path.rglob("*") if path.is_file()]
    assert len(found) == 3
    assert all(path.resolve().is_relative_to(inside) for path in found)
    assert set(tmp_path.parent.iterdir()) == before
    own = file.mission.fine_pointing.vibration.file
    assert (file.path.parent / own).read_text() == data["inputs"][named]
    assert moved == ({} if own == named else {named: own})
    assert file.mission.mirror.bouc_wen is not None


def test_a_plain_name_is_kept():
    for name in ("leo.tle", "orbits/leo 2.oem", "Bahn-Übergabe.csv"):
        assert manifest_reader.plain(name) == name
    assert [manifest_reader.plain(name) for name in EVIL] == [""] * len(EVIL)


@pytest.mark.parametrize(
    ("name", "kept"),
    [
        ("x" * 100, True),
        ("x" * 101, False),
        ("a/" + "x" * 100, True),
        ("ü" * 50, True),  # two bytes each
        ("ü" * 50 + "x", False),
        ("a/b/c/d.txt", True),
        ("a/b/c/d/e.txt", False),
        ("a//b.txt", False),
        ("a.", False),
        ("a b ", False),
    ],
)
def test_a_plain_name_has_at_most_four_parts_of_100_bytes(name, kept):
    assert manifest_reader.plain(name) == (name if kept else "")


def test_a_named_file_does_not_take_the_place_of_another(tmp_path):
    """The mission's own file is there already, under that name; the ending is kept."""
    at = manifest_reader.ReadManifest(tmp_path / "m.json", held(inputs={"m.csv": "new", "../n.longerthan8": "x"}), "")
    (tmp_path / "m.csv").write_text("old", encoding="utf-8")
    assert manifest_reader._place(tmp_path, 3, "m.csv", at) == "named-file-3.csv"
    assert manifest_reader._place(tmp_path, 4, "../n.longerthan8", at) == "named-file-4"
    texts = {path.name: path.read_text(encoding="utf-8") for path in tmp_path.iterdir()}
    assert texts == {"m.csv": "old", "named-file-3.csv": "new", "named-file-4": "x"}


def test_names_that_were_replaced_are_put_back_before_comparing():
    moved = {'../a"b<.tle': "named-file-0.tle"}
    again = reproduce.restored('{"file": "named-file-0.tle"}', moved, reproduce._in_json)
    assert json.loads(again) == {"file": '../a"b<.tle'}


@pytest.mark.promise("report-14", "report-21")
def test_a_mirror_file_that_is_not_carried_is_not_read(tmp_path, ran):
    secret = tmp_path / "secret.toml"
    secret.write_text('password = "open"\n')
    text = ran.file.text
    text = text[: text.index("[mirror]\n")] + f'[mirror]\nfile = "{secret}"\n' + text[text.index("[amplifier]\n") :]
    held = manifest_reader.ReadManifest(tmp_path / "report.html", {"mission": report_entry(ran.file, text=text)}, "")
    with pytest.raises(
        reproduce.ReproduceError, match="which the report does not carry; run the mission itself"
    ) as told:
        manifest_reader.unpack_mission(held, tmp_path / "inside")
    assert "password" not in str(told.value)


@pytest.mark.promise("report-14", "report-21")
def test_a_named_file_that_is_not_carried_is_refused(tmp_path):
    text = SHIPPED.read_text(encoding="utf-8")
    text = re.sub(r'(?m)^spectrum = "olympus".*\n', 'spectrum = "table"\nfile = "/etc/passwd"\n', text)
    file = missionfile.load_mission(SHIPPED)
    held = manifest_reader.ReadManifest(tmp_path / "report.html", {"mission": report_entry(file, text=text)}, "")
    with pytest.raises(
        reproduce.ReproduceError, match="the mission names /etc/passwd, which the report does not carry"
    ):
        manifest_reader.unpack_mission(held, tmp_path / "inside")


def test_control_characters_of_a_report_do_not_reach_the_terminal(not_run, changed, capsys):
    def coloured(data):
        data["summary"]["\x1b[31mred"] = "\x1b]0;title\x07"

    _, out, _ = call(capsys, changed(coloured))
    assert "\\u001b[31mred: was \\u001b]0;title\\u0007 and is (none)" in out
    assert "\x1b" not in out


# ------------------------------------------------------------------------------------------------------------ comparing
def test_the_relative_difference_is_over_the_larger_number():
    assert compared.relative(2.0, 1.0) == compared.relative(-1.0, -2.0) == 0.5
    assert compared.relative(1.0, -1.0) == 2.0
    assert compared.relative(0.0, 1e-16) == 0.0  # smaller than any quantity of a study
    assert compared.relative(6.0, 6.0 + 2.0**-50) == 2.0**-50 / (6.0 + 2.0**-50)  # the last bit
    assert compared.relative(0.0, 1e-9) == 1.0
    assert compared.relative(float("inf"), 1.0) == float("inf")
    assert compared.relative(float("inf"), float("inf")) == 0.0
    assert compared.relative(0.0, -compared.SMALLEST) == compared.relative(compared.SMALLEST, 0.0) == 0.0
    assert compared.relative(0.0, 2.0 * compared.SMALLEST) == 1.0


@pytest.mark.parametrize(
    ("was", "now", "limit", "same"),
    [
        (1.0, 1.5, 0.5, True),  # the limit itself
        (1.5, 1.0, 0.5, True),
        (-1.0, 1.0, 0.5, False),
        (1.0, 1.5, 0.25, False),
        (0.0, compared.SMALLEST, 0.0, True),
        (0.0, 2.0 * compared.SMALLEST, 0.0, False),
    ],
)
def test_two_numbers_are_the_same_up_to_the_limit_itself(was, now, limit, same):
    found = compared.compare({"a": was}, {"a": now}, lambda *_: limit)
    assert [(d.was, d.now, d.allowed) for d in found.differences] == ([] if same else [(was, now, limit)])
    assert compared.compare({"a": was}, {"a": now}, None).differences != ()


def test_a_difference_reads_as_a_line_with_its_size_and_what_is_allowed():
    apart = compared.Difference("margin_db.beacon", 2.0, 1.0, 0.5, 0.25)
    assert str(apart) == "margin_db.beacon: was 2 and is 1, relative difference 0.5 (0.25 apart is allowed)"
    assert apart.data() == {
        "place": "margin_db.beacon",
        "was": 2.0,
        "now": 1.0,
        "relative_difference": 0.5,
        "allowed_distance": 0.25,
    }
    word = compared.Difference("name", "PID", "PI", math.nan)
    assert str(word) == "name: was PID and is PI"
    assert (word.data()["relative_difference"], word.data()["allowed_distance"]) == (None, 0.0)
    third = compared.Difference("a", 1 / 3, 1 / 3 + 2.0**-53, 1e-16)  # nine digits do not tell them apart
    assert str(third).startswith("a: was 0.33333333333333331 and is 0.33333333333333343, relative")


def test_a_tree_in_place_of_a_value_is_one_difference():
    """A record, and a list, against something else; the unit beside a record is that of now."""
    was, now = {"a": {"b": 1.0}, "c": [1.0], "d": 2.0, "e": 3.0}, {"a": 1.0, "c": 1.0, "d": {"b": 2.0}, "e": [3.0]}
    found = compared.compare(was, now, None)
    assert {d.place: (d.was, d.now) for d in found.differences} == {key: (was[key], now[key]) for key in was}
    assert found.numbers == 0
    units = [unit for _, unit, _, _ in compared.leaves({"unit": "dB", "x": [1.0]}, {"unit": "rad", "x": [1.0]}, "")]
    assert units == ["rad", "rad"]
    assert [unit for _, unit, _, _ in compared.leaves({"unit": 3, "x": 1.0}, {"unit": 3, "x": 1.0}, "")] == ["", ""]


@pytest.mark.parametrize(
    ("length", "shown"), [(120, "x" * 120), (121, "x" * 119 + "\u2026"), (0, "")], ids=["fits", "one more", "none"]
)
def test_a_text_for_a_terminal_has_at_most_120_characters(length, shown):
    assert compared.clipped("x" * length) == shown


def a_millionth(place, unit, was, now):
    return 1e-6 * max(abs(was), abs(now))


@pytest.mark.promise("report-14")
def test_what_is_compared_and_what_counts():
    was = {"a": 1.0, "b": [1.0, 2.0], "c": True, "d": "3.10 dB left", "e": None, "g": "PID"}
    now = {"a": 1.0 + 1e-9, "b": [1.0, 2.1, 3.0], "c": 1, "d": "3.11 dB left", "f": 0.0, "g": "PI"}
    found = compared.compare(was, now, a_millionth)
    assert found.numbers == 3
    assert found.largest == pytest.approx(0.1 / 2.1)
    places = {d.place: (d.was, d.now) for d in found.differences}
    missing = compared.MISSING
    assert places == {
        "b[1]": (2.0, 2.1),
        "b[2]": (missing, 3.0),
        "c": (True, 1),
        "e": (None, missing),
        "f": (missing, 0.0),
        "g": ("PID", "PI"),
    }
    assert [d.place for d in compared.compare(was, now, None).differences] == ["a", *[*places][:3], "d", *[*places][3:]]
    assert compared.compare(was, was, None).differences == ()


@pytest.mark.promise("report-15")
def test_numbers_in_words_are_roundings_and_counts_are_not():
    def differ(was, now):
        return bool(compared.compare(was, now, a_millionth).differences)

    assert differ("x 3.1 dB", "x 3.3 dB")
    assert differ("x 3.1 dB", "y 3.1 dB")
    assert differ("in view 15 times", "in view 16 times")
    assert not differ("x 0.02 dB", "x 0.03 dB")
    assert not differ("x \u22123.1 dB", "x \u22123.2 dB")
    assert not differ("x 20 dB", "x 19 dB") and not differ("x -19 dB", "x -20 dB")  # a twentieth itself
    assert differ("x 20 dB", "x 18 dB") and differ("x \u221220 dB", "x 20 dB")
    assert differ("1.00e-5 of the time", "2.00e-5 of the time")  # its digits are not behind the point of 1e-5
    assert not differ("1.00e-5 of the time", "1.04e-5 of the time")
    assert differ("x 0.02 dB", "x 0.04 dB")
    assert compared.compare("x 3.1 dB", "x 3.2 dB", None).differences


def test_the_unit_is_that_of_the_key_or_stands_beside_the_value():
    assert tolerances.unit_of("margin_db.beacon") == "dB"
    assert tolerances.unit_of("simulated.given.axis_rms_rad[1]") == "rad"
    assert tolerances.unit_of("performance[0].data_rate_bit_s") == "bit/s"
    assert tolerances.unit_of("links.pointing.confidence") == ""
    line = {"unit": "dB", "value": 3.0}
    assert [unit for place, unit, _, _ in compared.leaves(line, line, "") if place == "value"] == ["dB"]


def test_a_column_with_more_rows_or_another_heading_is_told():
    def places(was, now):
        return [d.place for d in compared.compare_tables("fig", was, now, a_millionth).differences]

    table = "a (s),b\n1,2\n3,\n"
    assert places(table, table) == []
    assert places(table, "a (s),b\n1.0000001,2\n3,\n") == []
    assert places(table, "a (s),b\n1,2\n3,4\n5,\n") == ["fig: a (s), row 3", "fig: b, row 2"]
    assert places(table, "a (s),c\n1,2\n3,\n") == ["fig: b", "fig: c"]
    assert places(table, "a (s),b\n1,2\n") == ["fig: a (s), row 2"]
    assert [(d.was, d.now) for d in compared.compare_tables("fig", "a\n1\n", "b\n1\n", None).differences] == [
        ("a column", compared.MISSING),
        (compared.MISSING, "a column"),
    ]


@pytest.mark.parametrize(
    "was", ["", "a\r1\r", "a\n" + "1" * 200_000 + "\n"], ids=["empty", "other line ends", "a cell too long"]
)
def test_data_that_are_no_table_lack_its_columns(was):
    found = compared.compare_tables("fig", was, "a\n1\n", None)
    assert [(d.place, d.was, d.now) for d in found.differences] == [("fig: a", compared.MISSING, "a column")]


@pytest.mark.parametrize(("heading", "unit"), [("a (s)", "s"), ("a", ""), ("a (s) later", ""), ("a (x) (m/s)", "m/s")])
def test_the_unit_of_a_column_stands_in_brackets_at_the_end(heading, unit):
    asked = []

    def allowed(place, of, was, now):
        asked.append((place, of, was, now))
        return 0.0

    compared.compare_tables("fig", f"{heading}\n1\n", f"{heading}\n2\n", allowed)
    assert asked == [(f"fig: {heading}, row 1", unit, 1.0, 2.0)]


def test_a_text_is_the_same_as_itself_whatever_numbers_one_may_see_in_it():
    """As in a hash: "27e4e6c7429e67319e3b"."""
    text, other = "27e4e6c7429e67319e3b", "27e4e6c7429e67310e3b"

    def differ(was, now):
        return [d.place for d in compared.compare({"text": was}, {"text": now}, lambda *what: 0.0).differences]

    assert (differ(text, text), differ(text, other)) == ([], ["text"])


def test_a_number_of_thousands_of_digits_is_no_way_to_stop_it(changed, not_run):
    path = changed(lambda data: None)
    text = path.read_text(encoding="utf-8")
    at = re.search(r'"margin_db":\{"judged":[0-9.]+,"beacon":([0-9.]+)', text)
    path.write_text(text[: at.start(1)] + "9" * 10_000 + text[at.end(1) :], encoding="utf-8")
    found = reproduce.reproduce(path)
    assert [d.place for d in found.differences] == ["margin_db.beacon"]
    assert found.largest == float("inf")
    json.loads(json.dumps(reproduction_data(found), allow_nan=True))


# ---------------------------------------------------------------------------------------------------------------- words
def outcome(**changes):
    """What came out of a run of which nothing differs."""
    settings = {
        **{"path": "r.html", "numbers": 7, "largest": 0.0, "differences": (), "altered": (), "unlike": {}},
        **{"undetailed": "", "files": (), "read": (), "layout": False, "page": ()},
    }
    return reproduce.Reproduction(**{**settings, **changes})


DIFFERENCE = compared.Difference("a", 2.0, 1.0, 0.5)
COMPARED = "(7 numbers compared, largest relative difference 0)"


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({}, f"nothing differs {COMPARED}."),
        ({"largest": 1e-9}, "the numbers agree (7 numbers compared, largest relative difference 1e-09)."),
        ({"files": ("f.csv",), "read": ("f.csv",)}, f"the numbers agree {COMPARED}."),
        ({"files": ("f.csv", "g.csv"), "read": ("f.csv",)}, "other than this run's: data of figures."),
        ({"layout": True}, f"the numbers agree {COMPARED}; other than this run's: the page's layout."),
        ({"layout": True, "page": ("line 1: x",)}, "other than this run's: the page's text."),
        ({"files": ("f.csv",), "layout": True}, "other than this run's: data of figures, the page's layout."),
        ({"differences": (DIFFERENCE,)}, f"the report is not reproduced {COMPARED}: 1 differs."),
        ({"differences": (DIFFERENCE,) * 2}, f"the report is not reproduced {COMPARED}: 2 differ."),
        ({"altered": ("its page was changed",)}, "not reproduced {}: it was changed after it was written."),
        (
            {"differences": (DIFFERENCE,), "altered": ("its page was changed",)},
            "not reproduced {}: 1 differs, and it was changed after it was written.",
        ),
    ],
)
def test_the_headline_says_what_is_not_the_same(changes, said):
    found = outcome(**changes)
    assert reproduce.headline(found).startswith("r.html: ")
    assert reproduce.headline(found).endswith(said.replace("{}", COMPARED))
    assert found.same == ("not reproduced" not in said)


@pytest.mark.parametrize(
    ("changes", "lines"),
    [
        ({}, []),
        ({"differences": (DIFFERENCE,) * 40}, ["a: was 2 and is 1, relative difference 0.5"] * 40),
        (
            {"differences": (DIFFERENCE,) * 41},
            ["a: was 2 and is 1, relative difference 0.5"] * 40 + ["and 1 more (all of them with --json)"],
        ),
        ({"altered": ("its page was changed",)}, ["its page was changed"]),
        (
            {"files": ("f.csv", "g.csv", "h.csv"), "read": ("g.csv",)},
            [
                "data of figures, compared as numbers, not byte for byte the same: g.csv",
                "data of figures, not byte for byte the same: f.csv, h.csv; their numbers are not compared, since they "
                "do not stand beside the report, or have rows of their own on each machine",
            ],
        ),
        (
            {"files": ("g.csv",), "read": ("g.csv",)},
            ["data of figures, compared as numbers, not byte for byte the same: g.csv"],
        ),
        ({"page": ("1", "2", "3"), "layout": True}, ["the page's text is not what this run writes: 1; 2; 3"]),
        (
            {"page": ("1", "2", "3", "4"), "layout": True},
            ["the page's text is not what this run writes: 1; 2; 3; and 1 more"],
        ),
        ({"layout": True}, ["the page's layout or drawings are not what this run writes; its text is"]),
    ],
)
def test_the_text_lists_what_differs_below_the_headline(changes, lines):
    found = outcome(**changes)
    first, basis, *rest = reproduce.reproduction_text(found).splitlines()
    assert (first, basis) == (reproduce.headline(found), "Same machine and versions: compared to the last bit.")
    assert rest == lines


def test_a_report_without_hashes_of_its_files_has_no_other_figures(tmp_path):
    now = {"files_sha256": {"figures/a.csv": "1", "figures/a.svg": "1", "b.csv": "1", "figures/c.csv": "1"}}

    def other(**data):
        return reproduce._other_files(manifest_reader.ReadManifest(tmp_path / "m.json", held(**data), ""), now)

    assert other() == other(files_sha256={}) == []
    assert other(files_sha256={"figures/a.csv": "1", "figures/d.csv": "1"}) == ["figures/c.csv", "figures/d.csv"]
    assert other(files_sha256={"figures/a.csv": "2", "figures/c.csv": "1", "b.csv": "2"}) == ["figures/a.csv"]


# ------------------------------------------------------------------------------------------- outcomes with all of it
def test_an_outcome_in_which_all_differs_is_told_and_held_as_a_whole():
    differences = (
        compared.Difference("budget[1].margin_db", 2.0, 1.0, 0.5, 0.25),
        compared.Difference("verdict", "the loop is met", "the loop is\x07 missed", math.nan),
        compared.Difference("x", 1.0, math.inf, math.inf),
        compared.Difference("y", 0.123456789012345, 0.123456789099999, 7e-10, 1e-12),
    )
    found = outcome(
        numbers=1234,
        largest=math.inf,
        differences=differences,
        altered=("its summary was changed",),
        unlike={"numpy": ("1.2", "2.0"), "processor": ("none", "x86")},
        undetailed="x86_64",
        files=("figures/f.csv", "figures/g.csv"),
        read=("figures/g.csv",),
        page=("line 3: was a and is b",),
        layout=True,
    )
    assert reproduce.reproduction_text(found).split("\n") == [
        (
            "r.html: the report is not reproduced (1234 numbers compared, largest relative "
            "difference inf): 4 differ, and it was changed after it was written."
        ),
        (
            "Another machine or other versions: compared to stated tolerances (numpy was 1.2 "
            "and is 2.0; of its machine the report says no more than x86_64, as version 0.1.0 "
            "wrote it)."
        ),
        "its summary was changed",
        "budget[1].margin_db: was 2 and is 1, relative difference 0.5 (0.25 apart is allowed)",
        "verdict: was the loop is met and is the loop is\\u0007 missed",
        "x: was 1 and is inf, relative difference inf",
        ("y: was 0.123456789012345 and is 0.12345678909999901, relative difference 7e-10 (1e-12 apart is allowed)"),
        "data of figures, compared as numbers, not byte for byte the same: figures/g.csv",
        (
            "data of figures, not byte for byte the same: figures/f.csv; their numbers are not "
            "compared, since they do not stand beside the report, or have rows of their own on "
            "each machine"
        ),
        "the page's text is not what this run writes: line 3: was a and is b",
    ]
    data = reproduce.reproduction_data(found)
    data["differences"] = [{**each, "now": str(each["now"])} for each in data["differences"]]
    assert data == {
        "report": "r.html",
        "same": False,
        "compared": "to stated tolerances",
        "because": (
            "Another machine or other versions: compared to stated tolerances (numpy was 1.2 "
            "and is 2.0; of its machine the report says no more than x86_64, as version 0.1.0 "
            "wrote it)."
        ),
        "numbers": 1234,
        "largest_relative_difference": None,
        "differences": [
            {
                "place": "budget[1].margin_db",
                "was": 2.0,
                "now": "1.0",
                "relative_difference": 0.5,
                "allowed_distance": 0.25,
            },
            {
                "place": "verdict",
                "was": "the loop is met",
                "now": "the loop is\x07 missed",
                "relative_difference": None,
                "allowed_distance": 0.0,
            },
            {"place": "x", "was": 1.0, "now": "inf", "relative_difference": None, "allowed_distance": 0.0},
            {
                "place": "y",
                "was": 0.123456789012345,
                "now": "0.123456789099999",
                "relative_difference": 7e-10,
                "allowed_distance": 1e-12,
            },
        ],
        "altered": ["its summary was changed"],
        "machine_and_versions": {"numpy": {"was": "1.2", "now": "2.0"}, "processor": {"was": "none", "now": "x86"}},
        "figure_data": ["figures/f.csv", "figures/g.csv"],
        "figure_data_compared": ["figures/g.csv"],
        "layout": True,
        "page": ["line 3: was a and is b"],
    }


def test_trees_of_other_shapes_differ_at_the_places_that_one_of_them_lacks():
    was = {"a": [1.0, {"unit": "m", "value": 2.0}], "b": {"c": 1}, "d": True, "e": 5.0, "g": "x 3 and 4.0"}
    now = {"a": [1.0, {"unit": "m", "value": 2.5}, 7.0], "b": [1], "d": 1, "f": None, "g": "x 3 and 4.1"}
    units = []

    def allowed(place, unit, a, b):
        units.append((place, unit))
        return 0.25

    found = compared.compare(was, now, allowed)
    assert [str(each) for each in found.differences] == [
        "a[1].value: was 2 and is 2.5, relative difference 0.2 (0.25 apart is allowed)",
        "a[2]: was (none) and is 7",
        "b: was {'c': 1} and is [1]",
        "d: was True and is 1",
        "e: was 5 and is (none)",
        "f: was (none) and is None",
    ]
    assert (found.numbers, found.largest, units) == (
        2,
        0.2,
        [
            (
                "a[0]",
                "",
            ),
            (
                "a[1].value",
                "m",
            ),
        ],
    )
    assert len(compared.compare(was, now, None).differences) == len(found.differences) + 1
    both = found + compared.Comparison(3, 0.9, found.differences[:1])
    assert (both.numbers, both.largest, len(both.differences)) == (found.numbers + 3, 0.9, len(found.differences) + 1)


def test_tables_are_compared_by_column_and_row_with_the_unit_of_the_heading():
    was = "time (s),gain,gone (m)\n0,1,5\n1,2,\n2,x,\n"
    now = "gain,time (s),new\n1,0,1\n2.5,1.5,1\nx,2,1\n9,3,1\n"
    units = []

    def allowed(place, unit, a, b):
        units.append((place, unit))
        return 0.5

    found = compared.compare_tables("figures/f.csv", was, now, allowed)
    assert [str(each) for each in found.differences] == [
        "figures/f.csv: time (s), row 4: was  and is 3",
        "figures/f.csv: gain, row 4: was  and is 9",
        "figures/f.csv: gone (m): was a column and is (none)",
        "figures/f.csv: new: was (none) and is a column",
    ]
    assert units[:4] == [
        (
            "figures/f.csv: time (s), row 1",
            "s",
        ),
        (
            "figures/f.csv: time (s), row 2",
            "s",
        ),
        (
            "figures/f.csv: time (s), row 3",
            "s",
        ),
        (
            "figures/f.csv: gain, row 1",
            "",
        ),
    ]


# ------------------------------------------------------------------------------------------- line by line: what is told
@pytest.mark.parametrize(
    ("was", "now", "share", "allowed", "line"),
    [
        (1.0, 1.0000000001, 1e-10, 0.0, "was 1 and is 1.0000000001, relative difference 1e-10"),
        (-0.0, 0.0, 0.0, 1e-15, "was -0 and is 0, relative difference 0 (1e-15 apart is allowed)"),
        (True, 1, math.nan, 0.0, "was True and is 1"),
        ([1], "x\x1b", math.nan, 0.0, r"was [1] and is x\u001b"),
        (2.0**30 + 0.125, 2.0**30 + 0.25, 1.2e-10, 0.5, "1073741824.125 and is 1073741824.25, relative diff"),
        (None, math.nan, math.nan, 0.0, "was None and is nan"),
        (10**20, 1e20 + 20000, 2e-16, 0.0, "was 1e+20 and is 1.0000000000000002e+20, relative difference 2e-16"),
        (math.inf, 3, math.inf, 0.0, "was inf and is 3, relative difference inf"),
    ],
)
def test_a_difference_has_as_many_digits_as_it_takes(was, now, share, allowed, line):
    found = compared.Difference("a\tb", was, now, share, allowed)
    assert str(found).startswith(r"a\u0009b: was ") and line in str(found)
    known = share if math.isfinite(share) else None
    assert found.data() == {
        **{"place": "a\tb", "was": was, "now": now},
        **{"relative_difference": known, "allowed_distance": allowed},
    }


@pytest.mark.parametrize(
    ("was", "now", "same"),
    [
        *(("x 1.0", "x 1.1", True), ("x 10", "x 11", False), ("x 100", "x 104", True), ("x 100", "x 106", False)),
        *(("x 100", "x 105.2", True), ("x 105.2", "x 100", True), ("x 100", "x 105.3", False)),
        *(("x 1.00", "x 1.02", True), ("x 1.00", "x 1.06", False), ("x 0.010", "x 0.011", True), ("0", "1", False)),
        *(("−3.0 dB", "-3.1 dB", True), ("a1", "a2", False), ("1e-3", "1.02e-3", True), ("1.0e-3", "1.1e-3", False)),
        *(("1 2", "1 2 3", False), (True, 1, False), (None, None, True), ("5", "five", False), ([], [], True)),
        *(
            ("+2.5", "-2.5", False),
            ("", "", True),
            (None, "", False),
            ("PASS", "FAIL", False),
            ("7 of 9", "9 of 9", False),
        ),
    ],
)
def test_words_are_the_same_up_to_roundings_and_other_values_if_they_are_equal(was, now, same):
    assert compared._same(was, now, False) is same
    assert compared._same(was, now, True) is (type(was) is type(now) and was == now)


@pytest.mark.parametrize(
    ("value", "number"), [(3, True), (0.5, True), (True, False), ("3", False), (None, False), (math.nan, True)]
)
def test_a_truth_value_is_no_number(value, number):
    assert compared.is_number(value) is number


def test_trees_of_lists_within_lists_have_their_places_and_the_unit_above_them():
    was = {"unit": "m", "rows": [[1.0, 2.0], [3.0]], "deep": {"value": 4.0}}
    now = {"unit": "s", "rows": [[1.0], [3.0, 5.0]], "deep": {"value": 6.0}}
    assert list(compared.leaves(was, now, "top")) == [
        ("top.unit", "s", "m", "s"),
        ("top.rows[0][0]", "s", 1.0, 1.0),
        ("top.rows[0][1]", "s", 2.0, compared.MISSING),
        ("top.rows[1][0]", "s", 3.0, 3.0),
        ("top.rows[1][1]", "s", compared.MISSING, 5.0),
        ("top.deep.value", "", 4.0, 6.0),
    ]


@pytest.mark.parametrize(
    ("was", "now", "lines"),
    [
        ("a (m)\n1\n2", "a (m)\n1\n2", []),  # no end of the last line
        ("a\n", "a\n", []),
        ("", "a\n1\n", ["f: a: was (none) and is a column"]),
        ("a,b\n1\n2,3\n", "a,b\n1\n2,3,4\n", []),
        ("a\n1\nx\n", "a\n1\ny\n", ["f: a, row 2: was x and is y"]),
        ("b,a\n1,2\n", "a,b\n2,4\n", ["f: b, row 1: was 1 and is 4, relative difference 0.75"]),
        ("a\nnan\n", "a\n", ["f: a: was a column and is (none)"]),
    ],
)
def test_tables_with_odd_ends_are_compared_cell_by_cell(was, now, lines):
    found = compared.compare_tables("f", was, now, None)
    assert [str(each) for each in found.differences] == lines


def a_page(*body):
    return "\n".join(
        ["<html>", "<style>", "x", "</style>", *body, manifest.OPENING + "{}" + manifest.ENDING, "</html>"]
    )


@pytest.mark.parametrize(
    ("was", "now", "told"),
    [
        (["<p>a</p>"], ["<p>a</p>"], ()),
        (["<p>a <b>b</b></p>"], ["<i>a</i> b"], ()),
        (["<p>a</p>", "<p>b</p>"], ["<p>b</p>"], ("line 5: a",)),
        (["<p>b</p>"], ["<p>a</p>", "<p>b</p>"], ("1 lines of this run's page are not in it",)),
        (
            ["<svg>", "1", "</svg>", "z"],
            ["<svg>2</svg>", "y"],
            ("line 8: z", "1 lines of this run's page are not in it"),
        ),
        (["s", "s", "t"], ["s", "t", "u", "v"], ("line 5: s", "2 lines of this run's page are not in it")),
        (["<script>", "1", "2", "</script>e"], ["e"], ()),
    ],
)
def test_lines_of_a_page_are_told_by_their_number_in_the_file(was, now, told):
    assert reproduce._lines(a_page(*was), a_page(*now)) == told


@pytest.mark.parametrize(
    ("text", "moved", "written", "found"),
    [
        ("x named-0.csv y", {"a&b.csv": "named-0.csv"}, lambda name: name.replace("&", "&amp;"), "x a&amp;b.csv y"),
        ('"n1" "n2"', {'q"': "n1", "é": "n2"}, reproduce._in_json, '"q\\"" "é"'),
        ("unmoved", {}, str, "unmoved"),
        ("n1 n1", {"../up": "n1"}, str, "../up ../up"),
    ],
)
def test_names_of_files_are_put_back_as_they_are_written(text, moved, written, found):
    assert reproduce.restored(text, moved, written) == found


@pytest.mark.parametrize(
    ("unlike", "undetailed", "said"),
    [
        ({}, "", "Same machine and versions: compared to the last bit."),
        ({"numpy": ("1.9", "2.0")}, "", "compared to stated tolerances (numpy was 1.9 and is 2.0)."),
        ({"a": ("none", "1"), "b": ("2", "none")}, "", "stated tolerances (a was none and is 1; b was 2 and is none)."),
        (
            {"a": ("none", "1"), "b": ("2", "none")},
            "arm64",
            "(b was 2 and is none; of its machine the report says no more than arm64, as version 0.1.0 wrote it).",
        ),
    ],
)
def test_the_basis_names_each_thing_that_is_another(unlike, undetailed, said):
    assert reproduce.basis(outcome(unlike=unlike, undetailed=undetailed)).endswith(said)
    assert outcome(unlike=unlike).to_the_last_bit is (not unlike)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("<p>hello</p>", "is no report of microrad; name a report.html that microrad run wrote"),
        ("microrad study of x", "carries no manifest: it was cut short, or an earlier version wrote it; name the mani"),
        (manifest.OPENING * 3 + manifest.ENDING, "carries 3 manifests; a report has one, so this one was put together"),
        (manifest.OPENING + "{}", "ends within its manifest: it was cut short; name the whole report"),
        (manifest.OPENING + "{" + manifest.ENDING, "its manifest is no JSON (Expecting property name enclosed in doub"),
        (manifest.OPENING + "NaN" + manifest.ENDING, "its manifest is no JSON (NaN is no number of JSON); the report"),
        (manifest.OPENING + "[" * 200_000 + manifest.ENDING, "its manifest is nested too deeply; the report was chang"),
        (manifest.OPENING + "3" + manifest.ENDING, "no mission with file, sha256, text, text_sha256; no versions as"),
    ],
)
def test_a_page_that_is_none_is_refused_with_its_name_and_reason(tmp_path, text, words):
    path = tmp_path / "odd.html"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(manifest_reader.ReproduceError, match=re.escape(words)) as caught:
        manifest_reader.read_manifest(path)
    assert str(caught.value).startswith(f"{path}: ") and caught.value.page == "report"


@pytest.mark.parametrize(
    ("error", "words"),
    [
        (FileNotFoundError(), "there is no such file; name a report.html or a folder of results"),
        (IsADirectoryError(), "is a folder without a manifest.json; name a report.html or a folder of results"),
        (PermissionError(13, "Permission denied"), "cannot be read: Permission denied; name a report.html"),
        (OSError(5, "Input/output error"), "cannot be read: Input/output error; name a report.html"),
        (UnicodeDecodeError("utf-8", b"\xff", 0, 1, "bad"), "is no text, so no report of microrad; name a report.html"),
    ],
)
def test_what_goes_wrong_in_reading_is_told_by_its_kind(tmp_path, monkeypatch, error, words):
    path = tmp_path / "report.html"
    path.write_text("x", encoding="utf-8")

    def read(path, most):
        raise error

    monkeypatch.setattr(manifest_reader, "read_bytes", read)
    with pytest.raises(manifest_reader.ReproduceError) as caught:
        manifest_reader.read_manifest(path)
    assert str(caught.value) == f"{path}: {words}"


@pytest.mark.parametrize(
    ("changes", "faults"),
    [
        ({"mission": None}, "no mission with file, sha256, text, text_sha256"),
        ({"mirror": {"file": "m"}}, "no mirror with file, sha256, text, text_sha256"),
        ({"mirror": None, "machine": "x86_64"}, ""),
        ({"machine": {"processor": 3}}, "no machine as names with texts"),
        ({"versions": None}, "no versions as names with texts"),
        ({"inputs": {"a": 3}}, "no inputs as names with texts"),
        ({"inputs": {str(k): "" for k in range(17)}}, "more inputs than a mission names"),
        ({"inputs": {str(k): "" for k in range(16)}}, ""),
        ({"inputs_sha256": []}, "no inputs_sha256 as names with texts"),
        ({"files_sha256": {"a": None}}, "no files_sha256 as names with texts"),
        ({"summary": []}, "no summary, against which a run could be held"),
        (
            {"summary": 1, "versions": 2},
            "no versions as names with texts; no summary, against which a run could be held",
        ),
    ],
)
def test_each_fault_of_a_manifest_is_named_and_no_other(tmp_path, changes, faults):
    text = {"file": "m.toml", "sha256": "1", "text": "t", "text_sha256": "2"}
    data = {"mission": text, "mirror": text, "inputs": {}, "versions": {"python": "3"}, "summary": {}, **changes}
    path = tmp_path / "m.json"
    if not faults:
        manifest_reader._check(path, data)
        return
    with pytest.raises(manifest_reader.ReproduceError) as caught:
        manifest_reader._check(path, data)
    assert str(caught.value) == f"{path}: its manifest has {faults}: it is none of a study of this version"


@pytest.mark.parametrize(
    ("name", "ending"),
    [
        ("a.csv", ".csv"),
        ("../x.tle", ".tle"),
        ("a", ""),
        ("a.", ""),
        ("a.b.c1", ".c1"),
        ("a.longending", ""),
        ("a.x y", ""),
    ],
)
def test_a_file_that_is_renamed_keeps_a_short_ending(name, ending):
    assert manifest_reader._ending(name) == ending


@pytest.mark.parametrize(
    ("page", "shown"),
    [
        (f"a{manifest.OPENING}x{manifest.ENDING}b", "ab"),
        (f"a{manifest.OPENING}x", "a"),
        ("a</script>b", "a</script>b"),
        (f"a</script>{manifest.OPENING}x{manifest.ENDING}b</script>c", "a</script>b</script>c"),
    ],
)
def test_a_page_is_shown_without_its_manifest_and_takes_another(page, shown):
    assert manifest.shown_part(page) == shown
    assert manifest.hash_of_page(page) == hashlib.sha256(shown.encode()).hexdigest()
    if page.count(manifest.ENDING) > page.count("</script>b"):
        assert manifest.shown_part(manifest.with_manifest(page, "new")) == shown


def test_a_manifest_in_a_page_ends_no_element_and_hashes_are_of_utf_8():
    data = {"a": "</script><b>&", "ä": [1.5, None]}
    text = manifest.embedded(data)
    assert not {"<", ">", "&"} & set(text) and json.loads(text) == data and "ä" in text
    assert manifest.hash_of_summary(data) == hashlib.sha256('{"a":"</script><b>&","ä":[1.5,null]}'.encode()).hexdigest()
    assert manifest.text_sha256("\ud800") == hashlib.sha256(b"\xed\xa0\x80").hexdigest()
    with pytest.raises(ValueError, match="JSON"):
        manifest.embedded({"a": math.nan})


def test_a_manifest_is_written_with_the_hash_of_each_file_by_its_place(tmp_path):
    (tmp_path / "figures").mkdir()
    (tmp_path / "figures" / "b.csv").write_bytes(b"1")
    (tmp_path / "a.html").write_bytes(b"2")
    manifest.write_manifest({"x": "ä", "files_sha256": {}}, tmp_path, "m.json")
    text = (tmp_path / "m.json").read_text(encoding="utf-8")
    assert text.startswith('{\n  "x": "ä",') and text.endswith("}\n")
    assert json.loads(text)["files_sha256"] == {
        "a.html": hashlib.sha256(b"2").hexdigest(),
        "figures/b.csv": hashlib.sha256(b"1").hexdigest(),
    }


@pytest.mark.parametrize(
    ("drawn", "scan", "said"),
    [
        ({}, None, "none"),
        ({"fine_pointing": (7, 64)}, None, "seed 7 of [fine_pointing], 64 runs"),
        (
            {"operations": (3, 40), "acquisition": (5, 1)},
            None,
            "seed 5 of [acquisition], 1 runs; seed 3 of [operations], 40",
        ),
        (
            {"acquisition": (5, 9)},
            1,
            f"[acquisition], 9 runs; seed {manifest.SEED} of the virtual bench, {manifest.PLAN}",
        ),
    ],
)
def test_a_manifest_names_each_seed_and_carries_what_was_read(tmp_path, drawn, scan, said):
    tables = dict.fromkeys(("fine_pointing", "acquisition", "operations"))
    tables |= {name: SimpleNamespace(seed=seed, runs=runs) for name, (seed, runs) in drawn.items()}
    contents = [SimpleNamespace(name=n, content=c) for n, c in (("a", b"ab"), ("b", None), ("c", b"\xff"))]
    mission = {"path": Path("x/m.toml"), "sha256": "1", "text": "t", "mirror_file": None, "contents": contents}
    run = SimpleNamespace(file=SimpleNamespace(mission=SimpleNamespace(**tables), **mission), scan=scan)
    (tmp_path / "f").write_bytes(b"f")
    made = manifest.manifest_of(run, {"a": math.inf}, tmp_path)
    hashes = {name: hashlib.sha256(text).hexdigest() for name, text in (("a", b"ab"), ("c", b"\xff"), ("f", b"f"))}
    text = {"file": "m.toml", "sha256": "1", "text_sha256": hashlib.sha256(b"t").hexdigest(), "text": "t"}
    assert made["randomness"].endswith(said) if scan else made["randomness"].startswith(said)
    assert {key: made[key] for key in ("mission", "inputs", "mirror", "summary")} == {
        **{"mission": text, "inputs": {"a": "ab"}, "mirror": None, "summary": {"a": None}},
    }
    assert made["inputs_sha256"] == {"a": hashes["a"], "c": hashes["c"]} and made["files_sha256"] == {"f": hashes["f"]}
    assert made["summary_sha256"] == manifest.hash_of_summary({"a": None})
    assert (made["versions"], made["machine"]) == (machine.versions(), machine.machine())


@pytest.mark.parametrize(
    ("kind", "resolution", "step"),
    [
        ("drive", 0.5, 2e-5 * 0.5),
        ("sensor", 3e-6, 3e-6),
        ("fine", 0.25, 5e-6),
        ("light", 7e-6, 7e-6),
        ("gauge", 9e-6, 9e-6),
    ],
)
def test_the_step_of_a_mission_is_the_largest_of_its_converters(monkeypatch, kind, resolution, step):
    at = {"drive": 0.0, "sensor": 0.0, "fine": 0.0, "light": 0.0, "gauge": 0.0, kind: resolution}
    monkeypatch.setattr(tolerances, "slow_gain", lambda model: -2e-5)
    control = SimpleNamespace(drive_resolution_v=at["drive"], sensor_resolution_rad=at["sensor"])
    loop = SimpleNamespace(
        strain_gauge=SimpleNamespace(resolution_rad=at["gauge"]) if kind == "gauge" else None,
        drive_resolution_v=at["fine"],
        optical_sensor=SimpleNamespace(resolution_rad=at["light"]),
        runs=16,
    )
    table = {"control": control, "fine_pointing": loop, "requirement": SimpleNamespace(pointing_error_rad=4e-5)}
    table |= {"acquisition": SimpleNamespace(runs=500), "operations": SimpleNamespace(runs=30)}
    table["communication"] = SimpleNamespace(data_rate_bit_s=622.08e6)
    beam = SimpleNamespace(fall=SimpleNamespace(loss_db=lambda error_rad: (error_rad / 1e-5) ** 2))
    run = SimpleNamespace(
        file=SimpleNamespace(mission=SimpleNamespace(**table)),
        summary=SimpleNamespace(model=None),
        links=SimpleNamespace(data=SimpleNamespace(beam=beam)),
        fine_pointing=SimpleNamespace(optimum_rad=1.5e-6, budget=SimpleNamespace(full_rad=8e-6)),
    )
    found = tolerances.converter_steps(run)
    at_limit = (4.0 + 2.0 * step / 1e-5) ** 2 - 16.0, (4.0 + 0.5 * step / 1e-5) ** 2 - 16.0
    assert (found.step_rad, found.run_db, found.runs_db) == pytest.approx((step, *at_limit))
    assert (found.run_rad, found.runs_rad) == pytest.approx((2.0 * step, 0.5 * step))
    assert (found.runs, found.allowed_rad, found.rms_rad, found.full_rad) == (16, 4e-5, 1.5e-6, 8e-6)
    assert (found.rate_bit_s, found.acquisitions, found.days) == (622.08e6, 500, 30)


@pytest.mark.parametrize(
    ("text", "place", "fits"),
    [
        *(("a.*", "a.b.c", True), ("a.*", "a", False), ("a[].b", "a[].b", True), ("a[].b", "axb", False)),
        *(
            ("{a,b.c}.d", "b.c.d", True),
            ("{a,b.c}.d", "bxc.d", False),
            ("a.{x,y}[]", "a.y[]", True),
            ("a", "aa", False),
        ),
    ],
)
def test_a_pattern_of_places_has_dots_lists_and_choices(text, place, fits):
    assert bool(tolerances._pattern(text).fullmatch(place)) is fits


@pytest.mark.parametrize("unlike", [{}, {"numpy": ("1.2", "2.0")}])
@pytest.mark.parametrize("differences", [(), (DIFFERENCE,)])
def test_what_is_compared_to_the_last_bit_depends_on_the_machine_and_not_on_what_differs(unlike, differences):
    data = reproduction_data(outcome(unlike=unlike, differences=differences))
    assert data["same"] == (not differences)
    assert data["compared"] == ("to stated tolerances" if unlike else "to the last bit")


@pytest.mark.parametrize("name", ["manifest.JSON", "my.Json"])
def test_a_manifest_is_told_from_a_page_whatever_the_case_of_its_ending(tmp_path, name):
    path = tmp_path / name
    path.write_text(json.dumps(held()), encoding="utf-8")
    found = manifest_reader.read_manifest(path)
    assert (found.data, found.page, found.path) == (held(), "", path)


def test_what_is_altered_of_mission_mirror_and_named_files_is_told_of_each_by_its_own_hash(tmp_path):
    """Two of four texts were changed; the same text stands in two of them."""

    def entry(text, stated=None):
        digest = hashlib.sha256((text if stated is None else stated).encode()).hexdigest()
        return {"file": "a", "sha256": "0" * 64, "text": text, "text_sha256": digest}

    inputs = {"same.csv": "m", "other.csv": "changed", "unstated.csv": "u"}
    hashes = {"other.csv": entry("o")["text_sha256"], "same.csv": entry("m")["text_sha256"], "gone.csv": "0" * 64}
    data = held(mission=entry("m"), mirror=entry("mirror", "another"), inputs=inputs, inputs_sha256=hashes)
    found = manifest_reader.altered_parts(manifest_reader.ReadManifest(tmp_path / "m.json", data, ""))
    own = {text: hashlib.sha256(text.encode()).hexdigest()[:16] for text in ("mirror", "changed", "another", "o", "u")}
    end = "was changed after the report was written: its SHA-256 is"
    assert found == (
        f"the mirror file's text {end} {own['mirror']}…, and {own['another']}… is stated",
        f"the text of other.csv {end} {own['changed']}…, and {own['o']}… is stated",
        f"the text of unstated.csv {end} {own['u']}…, and … is stated",
    )


STEPS = tolerances.ConverterSteps(1e-8, 4, 1e-5, 4e-6, 5e-6, 0.01, 0.005, 3e8, 1000, 10)


@pytest.mark.parametrize(
    ("place", "unit", "allowed"),
    [
        ("links.budgets[0].lines[2].value", "dB", 1e-8),  # the unit beside it
        ("links.budgets[0].lines[2].value", "", 1e-12),
        ("links.finding.spread_rad", "dB", 1e-12),  # that of its key comes first
        ("contact.windows[3].rms_rad", "", 2e-8),
        ("nowhere.rms_rad", "dB", 0.0),
    ],
)
def test_a_number_near_0_may_move_by_the_distance_of_its_own_unit_or_the_one_beside_it(place, unit, allowed):
    assert reproduce.of_summary(STEPS)(place, unit, 0.0, 0.0) == pytest.approx(allowed, rel=1e-12)


@pytest.mark.parametrize(
    ("name", "share", "elsewhere", "same"),
    [
        ("tornado", 1.8e-8, True, True),  # a formula's 1e-8, and 1e-8 for nine digits
        ("tornado", 2.2e-8, True, False),
        ("tornado", 1e-9, False, False),
        ("claims-scan", 0.8e-8, True, True),
        ("claims-scan", 1.2e-8, True, False),
        ("of-no-kind", 0.8e-8, True, True),
        ("of-no-kind", 1.2e-8, True, False),
    ],
)
def test_the_data_of_a_figure_may_move_by_its_kind_and_its_digits(tmp_path, name, share, elsewhere, same):
    """The second of two columns moves; a table that another machine wrote has other line ends."""
    file = f"figures/{name}.csv"
    for folder, text in (("was", "a,b (W)\r\n1,2\r\n3,4\r\n"), ("now", f"a,b (W)\n1,2\n3,{4.0 * (1.0 + share)!r}\n")):
        (tmp_path / folder / "figures").mkdir(parents=True)
        (tmp_path / folder / file).write_bytes(text.encode())
    was = manifest_reader.ReadManifest(tmp_path / "was" / "report.html", held(), "")
    again = reproduce.Again({}, "", tmp_path / "now", STEPS)
    found = reproduce._of_tables(was, again, file, elsewhere)
    assert found.numbers == 4
    assert [each.place for each in found.differences] == ([] if same else [f"{file}: b (W), row 2"])


@pytest.mark.parametrize(
    ("name", "here", "there", "elsewhere", "read"),
    [
        ("tornado", True, True, True, True),
        ("tornado", True, True, False, True),
        ("tornado", False, True, False, False),
        ("tornado", True, False, False, False),
        ("latency", True, True, True, False),  # a curve has points of its own on each machine
        ("latency", True, True, False, True),
    ],
)
def test_the_data_of_a_figure_are_compared_where_both_are_at_hand_in_the_same_rows(
    tmp_path, name, here, there, elsewhere, read
):
    file = f"figures/{name}.csv"
    for folder, made in (("was", there), ("now", here)):
        (tmp_path / folder / "figures").mkdir(parents=True)
        if made:
            (tmp_path / folder / file).write_text("a\n1\n", encoding="utf-8")
    was = manifest_reader.ReadManifest(tmp_path / "was" / "report.html", held(), "")
    again = reproduce.Again({}, "", tmp_path / "now", STEPS)
    assert reproduce._comparable(was, again, file, elsewhere) is read


def test_a_mission_that_does_not_run_is_refused_by_the_name_that_was_given(tmp_path, monkeypatch):
    def fails(file, on_progress):
        raise ValueError("its loop is unstable")

    monkeypatch.setattr(reproduce, "read_manifest", lambda path: manifest_reader.ReadManifest(path / "m", held(), ""))
    monkeypatch.setattr(reproduce, "unpack_mission", lambda manifest, folder: (None, {}))
    monkeypatch.setattr(reproduce.study, "run_study", fails)
    with pytest.raises(reproduce.ReproduceError) as refused:
        reproduce.reproduce(tmp_path)
    assert str(refused.value) == f"{tmp_path}: the mission that it carries does not run: its loop is unstable"


def test_what_is_run_again_is_compared_with_the_names_that_the_mission_gives_in_page_and_manifest(
    tmp_path, monkeypatch
):
    """Two files that the mission names stand under other names in the folder where it is run."""
    told, was = [], manifest_reader.ReadManifest(tmp_path / "r.html", held(), "page")
    moved = {'a&"b".csv': "named-file-0.csv", "../c.csv": "named-file-1.csv"}

    def write(ran, folder, on_progress):
        folder.mkdir(parents=True)
        (folder / "manifest.json").write_text('{"0": "named-file-0.csv", "1": "named-file-1.csv"}', encoding="utf-8")
        (folder / "report.html").write_text("named-file-1.csv, named-file-0.csv", encoding="utf-8")
        on_progress(2, 2, f"written of {ran}")
        return folder / "report.html"

    def unpacked(manifest, folder):
        told.append((manifest, folder.name))
        return "mission", moved

    monkeypatch.setattr(reproduce, "read_manifest", lambda path: was)
    monkeypatch.setattr(reproduce, "unpack_mission", unpacked)
    monkeypatch.setattr(
        reproduce.study, "run_study", lambda file, on_progress: on_progress(1, 2, f"ran {file}") or "a study"
    )
    monkeypatch.setattr(reproduce.report, "write", write)
    monkeypatch.setattr(reproduce, "converter_steps", lambda ran: f"steps of {ran}")
    monkeypatch.setattr(reproduce, "_compared", lambda manifest, again: (manifest, again))
    manifest_was, again = reproduce.reproduce(tmp_path / "r.html", lambda *progress: told.append(progress))
    assert manifest_was is was
    assert again.manifest == {"0": 'a&"b".csv', "1": "../c.csv"}
    assert again.page == "../c.csv, a&amp;&#34;b&#34;.csv"
    assert (again.folder.name, again.steps) == ("again", "steps of a study")
    assert told == [(was, "study"), (1, 2, "ran mission"), (2, 2, "written of a study")]
    assert not again.folder.exists()


@pytest.mark.parametrize(
    ("names", "own"),
    [
        (["a", "a/b.csv"], ["a", "named-file-1.csv"]),
        (["a/b.csv", "a"], ["a/b.csv", "named-file-1"]),
        (["a/b.csv", "a/b.csv/c/d.txt", "a/c.csv"], ["a/b.csv", "named-file-1.txt", "a/c.csv"]),
    ],
)
def test_a_named_file_is_no_folder_of_another(tmp_path, names, own):
    at = manifest_reader.ReadManifest(tmp_path / "m.json", held(inputs={name: f"of {name}" for name in names}), "")
    assert [manifest_reader._place(tmp_path, number, name, at) for number, name in enumerate(names)] == own
    files = {p.relative_to(tmp_path).as_posix(): p.read_text("utf-8") for p in tmp_path.rglob("*") if p.is_file()}
    assert files == {place: f"of {name}" for place, name in zip(own, names, strict=True)}


@pytest.mark.parametrize("mirror", ['"a file"', "7", '["file"]'])
def test_a_mission_whose_mirror_is_no_table_is_refused_by_its_fault(tmp_path, mirror):
    file = missionfile.load_mission(SHIPPED)
    text = file.text
    begin, end = text.index("[mirror]\n"), text.index("[amplifier]\n")
    text = f"mirror = {mirror}\n{text[:begin]}{text[end:]}"
    held = manifest_reader.ReadManifest(tmp_path / "report.html", {"mission": report_entry(file, text=text)}, "")
    with pytest.raises(missionfile.MissionError, match="mirror"):
        manifest_reader.unpack_mission(held, tmp_path / "inside")


@pytest.mark.parametrize(("name", "length"), [("mirror", 5), ("mission", 12)])
def test_a_text_of_the_greatest_length_is_read_and_a_longer_one_is_told_with_its_name_and_length(
    monkeypatch, name, length
):
    monkeypatch.setattr(manifest_reader, "MOST_TEXT", 4)
    entry = {"file": "a file of a long name", "sha256": "0" * 64, "text_sha256": "0" * 64}
    assert list(manifest_reader._file_faults(name, {**entry, "text": "four"})) == []
    assert list(manifest_reader._file_faults(name, {**entry, "text": "f" * length})) == [
        f"a {name} text of {length} characters"
    ]
    for lacking in ("file", "sha256", "text", "text_sha256"):
        held = {**entry, "text": "four"} | {lacking: None}
        assert list(manifest_reader._file_faults(name, held)) == [f"no {name} with file, sha256, text, text_sha256"]
    assert list(manifest_reader._file_faults(name, "four")) == [f"no {name} with file, sha256, text, text_sha256"]


@pytest.mark.parametrize(
    ("was", "now", "near"),
    [
        ("0.001", "1.9e-3", True),  # the last digit of the first
        ("0.001", "2.1e-3", False),
        ("1.9e-3", "0.001", False),  # one with a power has no last digit that counts
        ("1.00e-3", "1.02e-3", True),
        ("1e-3", "0.00102", True),
        ("7", "7.3", True),
        ("7", "8", False),
    ],
)
def test_a_number_may_be_off_by_the_last_digit_of_that_which_was_written(was, now, near):
    assert compared._near_in_words(was, now) is near


@pytest.mark.parametrize(
    ("was", "now", "line"),
    [
        (1.2345678, 1.2345679, "was 1.2345678 and is 1.2345679,"),
        (1.23456789, 1.2345679, "was 1.23456789 and is 1.2345679,"),
        (-123456.7, -123456.8, "was -123456.7 and is -123456.8,"),
    ],
)
def test_two_numbers_that_differ_in_their_nine_digits_are_told_with_those(was, now, line):
    assert line in str(compared.Difference("a", was, now, 1e-8))


def test_rows_that_end_early_lack_cells_and_no_column():
    found = compared.compare_tables("f", "a,b,c\n1,2\n3,4,5\n", "a,b,c\n1,2,6\n3\n", None)
    assert [(each.place, each.was, each.now) for each in found.differences] == [
        ("f: b, row 2", 4.0, ""),
        ("f: c, row 1", "", 6.0),
        ("f: c, row 2", 5.0, ""),
    ]
    assert found.numbers == 3


@pytest.mark.parametrize("mirror", [{}, "", 0, False, []])
def test_a_mirror_of_a_manifest_is_none_or_a_file_whatever_is_empty(tmp_path, mirror):
    with pytest.raises(manifest_reader.ReproduceError, match="has no mirror with file, sha256, text, text_sha256: it"):
        manifest_reader._check(tmp_path / "m.json", held(mirror=mirror))


@pytest.mark.parametrize(("lengths", "many"), [((7, 7, 6), False), ((7, 7, 7), True), ((21,), True), ((20, 0), False)])
def test_texts_of_named_files_are_bounded_together(tmp_path, monkeypatch, lengths, many):
    monkeypatch.setattr(manifest_reader, "MOST_TEXT", 20)
    texts = {str(k): "x" * length for k, length in enumerate(lengths)}
    assert list(manifest_reader._texts_faults("inputs", texts)) == ["more inputs than a mission names"] * many
    assert list(manifest_reader._texts_faults("versions", texts)) == []


def test_mission_and_mirror_that_are_unpacked_have_each_its_own_hash(tmp_path, monkeypatch):
    def entry(name, text, stated):
        digest = hashlib.sha256(text.encode()).hexdigest()
        return {"file": name, "sha256": stated, "text": text, "text_sha256": digest}

    @dataclasses.dataclass(frozen=True)
    class Read:
        sha256: str
        mirror_file: object = None
        mission: object = None

    read = []
    monkeypatch.setattr(manifest_reader.missionfile, "named_files", lambda mission: ())
    monkeypatch.setattr(manifest_reader, "renamed", lambda mission, moved: mission)
    load = lambda *places: read.append(places) or Read("own", Read("mirror's own"), "mission")  # noqa: E731
    monkeypatch.setattr(manifest_reader.missionfile, "load_mission", load)
    data = held(mission=entry("m.toml", "a = 1\n", "stated 1"), mirror=entry("n.toml", "b = 2\n", "stated 2"))
    found, moved = manifest_reader.unpack_mission(manifest_reader.ReadManifest(tmp_path, data, ""), tmp_path / "in")
    assert (found.sha256, found.mirror_file.sha256, moved) == ("stated 1", "stated 2", {})
    ((mission, mirror),) = read
    assert (mission.name, mission.read_text(), mirror.name, mirror.read_text()) == (
        *("m.toml", "a = 1\n"),
        *("n.toml", "b = 2\n"),
    )


def test_no_sign_of_markup_is_left_in_a_manifest_within_a_page_however_many_there_are():
    given = {"a": "<b>&amp;</b> & <c>", "<&>": ["&&", ">>", "<<"]}
    text = manifest.embedded(given)
    assert not set("<>&") & set(text) and json.loads(text) == given
