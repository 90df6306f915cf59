"""The command that verifies this installation: what it writes and prints, its exit code, what it refuses."""

import json

import pytest

from command_line import listing
from microrad.core.integrity import Integrity
from microrad.report.verification import check, findings
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
