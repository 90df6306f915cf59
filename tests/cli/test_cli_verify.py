"""The command that verifies this installation: what it writes and prints, its exit code, what it refuses."""

import json
import math
from types import SimpleNamespace

import pytest

from command_line import listing
from microrad.core.integrity import Integrity
from microrad.report.verification import check, findings, page
from microrad.report.verification.evidence import Comparison, Referent

WHOLE = Integrity("commit 0")


def checked(holds):
    compared = [
        Comparison("budget.budgets.Beacon.margin_db", "margin", 3.0, 3.0 if holds else 4.0, 0.1, "dB", "rounding")
    ]
    return check.Check("one", "a margin", Referent.INDEPENDENT, "by hand", "a book", lambda _: iter(compared))


@pytest.fixture
def evidence(monkeypatch):
    """Sets what is found: one check, which holds or does not, and the files."""

    def found(holds=True, files=WHOLE):
        monkeypatch.setattr(findings, "every", lambda: (checked(holds),))
        monkeypatch.setattr(findings, "integrity", lambda: files)

    return found


@pytest.mark.promise("readme-5")
@pytest.mark.promise("verification-2")
@pytest.mark.promise("readme-23")
def test_report_and_data_are_written_and_the_outcome_is_told(call, tmp_path, evidence):
    evidence()
    result = call("verify", "--output", tmp_path / "evidence")
    assert result.code == 0
    assert result.out.startswith("All 1 comparisons hold in this installation.")
    assert "Against the commit 0: every file as recorded." in result.out
    data = json.loads((tmp_path / "evidence" / "verification.json").read_text(encoding="utf-8"))
    assert data["ok"] is True
    assert data["evidence"][0]["comparisons"][0]["since"] == "rounding"
    html = (tmp_path / "evidence" / "verification.html").read_text(encoding="utf-8")
    assert "All 1 comparisons hold in this installation." in html
    assert "http" not in html.replace("http://www.w3.org", "")


@pytest.mark.promise("verification-1")
def test_a_comparison_that_fails_is_shown_and_exits_with_1(call, tmp_path, evidence):
    evidence(holds=False)
    result = call("verify", "--output", tmp_path)
    assert result.code == 1
    assert result.out.startswith("This installation does not hold: 1 of 1 comparisons are beyond their tolerance.")
    assert "4 FAIL" in result.out


@pytest.mark.promise("verification-1")
def test_a_changed_file_exits_with_1(call, tmp_path, evidence):
    evidence(files=Integrity("record of the wheel", changed=("link/gains.py",)))
    result = call("verify", "--output", tmp_path, "--json")
    assert result.code == 1
    data = json.loads(result.out)
    assert data["headline"] == "All 1 comparisons hold, but this is not the recorded installation."
    assert data["files"]["changed"] == ["link/gains.py"]


@pytest.mark.promise("verification-2")
def test_without_a_folder_the_current_one_has_the_report_and_json_is_the_same_data(call, folder, evidence):
    evidence()
    result = call("verify", "--json")
    written = listing(folder)
    assert set(written) == {"verification.html", "verification.json"}
    assert result.out == written["verification.json"].decode()


@pytest.mark.promise("verification-13")
def test_another_version_of_a_library_exits_with_1(call, folder, evidence):
    evidence(files=Integrity("record of the wheel", versions=("numpy 3.0 (tested: 2.0)",)))
    result = call("verify")
    assert result.code == 1
    assert "Not the tested version: numpy 3.0 (tested: 2.0)." in " ".join(result.out.split())
    assert "numpy 3.0 (tested: 2.0)" in (folder / "verification.html").read_text(encoding="utf-8")


@pytest.mark.promise("verification-2", "verification-10")
def test_domains_wait_for_full(call, tmp_path, evidence, monkeypatch):
    swept = {"The links": {"draws": 1, "inside": 1, "checks": [], "extents": {}}}
    monkeypatch.setattr(findings, "swept", lambda **options: swept)
    monkeypatch.setattr(findings, "dependences", lambda **options: {"Link margin | Beacon": ["a"]})
    evidence()
    for words, full in ((("verify",), False), (("verify", "--full"), True)):
        data = json.loads(call(*words, "--output", tmp_path, "--json").out)
        assert data["full"] is full
        assert (data["domains"] == swept) is full
        assert (tmp_path / "domains.json").exists() is full
    held = json.loads((tmp_path / "domains.json").read_text(encoding="utf-8"))
    assert (held["domains"], held["depends"]) == (swept, {"Link margin | Beacon": ["a"]})


def test_a_folder_that_is_a_file_is_refused_before_anything_runs(call, tmp_path, monkeypatch):
    monkeypatch.setattr(findings, "every", lambda: pytest.fail("it ran"))
    (tmp_path / "taken").write_text("", encoding="utf-8")
    result = call("verify", "--output", tmp_path / "taken")
    assert result.code == 2
    assert "taken" in result.err
    assert len(result.err.strip().splitlines()) == 1


@pytest.mark.parametrize(
    ("words", "full", "place", "ok"),
    [
        ((), False, "", True),
        (("--full",), True, "", False),
        (("--output", "a b/deep"), False, "a b/deep/", False),
        (("--output", "x", "--full"), True, "x/", True),
    ],
)
def test_what_is_written_is_listed_behind_the_text_in_its_order(call, folder, monkeypatch, words, full, place, ok):
    asked, found = [], SimpleNamespace(ok=ok)
    monkeypatch.setenv("COLUMNS", "97")
    monkeypatch.setattr(findings, "verify", lambda **more: asked.append(more) or found)
    for name, said in (("data", {"n": math.nan}), ("page", "<!page>"), ("text", None)):
        made = (lambda found, width: f"told in {width}") if said is None else (lambda found, said=said: said)
        monkeypatch.setattr(page, f"verification_{name}", made)
    monkeypatch.setattr(page, "domains_text", lambda found: "domains")
    files = {"verification.html": b"<!page>", "verification.json": b'{\n  "n": null\n}\n', "domains.json": b"domains"}
    names = [*files][: 3 if full else 2]
    shown = call("verify", *words)
    assert (shown.code, asked[0]["full"], callable(asked[0]["on_progress"])) == (int(not ok), full, True)
    assert shown.out == "told in 97\n\n" + "".join(f"{place}{name}\n" for name in names) + "\n"
    written = {name: content for name, content in listing(folder).items() if content}
    assert written == {f"{place}{name}": files[name] for name in names}
    assert call("verify", *words, "--json").out == '{\n  "n": null\n}\n'
