"""The budget of pointing errors in the study: its requirements in the verdict, and the loop as one of its sources."""

import json
import math
from dataclasses import replace

import pytest

from budget_files import KEPT, TABLE, kept_study, loaded, looped_study, mission_text
from microrad import report
from microrad.link.requirement import IMPOSSIBLE
from microrad.loop import controller_study
from microrad.mirror import Variant
from microrad.report.error_budget.data import budget_data
from microrad.report.study import chain, contributors, words
from microrad.report.study.data import summary
from microrad.study import paper, study, verdict
from shipped import plain_study, whole_study

BEGIN, END = (TABLE.index(f"[error_budget.requirements.{name}]") for name in ("code_word", "drift"))
MISSED = (*KEPT[1:], (TABLE[BEGIN:END], ""))
"""Changes by which the mission without a loop misses the one requirement that it has."""


def budget_lines(found):
    return [each for each in found.requirements if each.subject == "error budget"]


@pytest.fixture(scope="module")
def missed():
    """The study of the mission whose budget misses its requirement."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(paper, "applies", lambda mission: False)
        return study.run_study(loaded(*MISSED))


@pytest.mark.promise("report-8")
@pytest.mark.promise("pointing-47")
def test_each_requirement_of_the_table_is_a_line_of_the_verdict_by_the_full_distribution():
    found = kept_study()
    word, drift = budget_lines(found)
    assert (word.name, drift.name) == ("code word (RPE)", "drift (APE)")
    for line, of in zip((word, drift), found.error_budget.judged, strict=True):
        assert (line.required, line.actual) == (of.total.required.limit_rad, of.total.quantile_rad)
        assert line.margin == line.required - line.actual
        assert line.limited_by == of.shares[0].name.replace("_", " ")
    assert (found.met, drift.mark) == (True, "PASS")
    text = words.verdict_text(found)
    assert "drift (APE)" in text and "every requirement is met" in text
    assert chain.stages(found)[-3].lines[-1] == "error budget: 2 of 2 kept"


@pytest.mark.promise("report-6", "report-8")
def test_a_requirement_that_is_missed_says_what_contributes_most_and_how_large_that_may_be(missed):
    (drift,) = budget_lines(missed)
    assert (missed.met, drift.mark, missed.closes) == (False, "FAIL", True)
    text = " ".join(words.verdict_text(missed).split())
    assert text.startswith("Not every requirement is met: drift (APE) (")
    assert "What limits it is the drift (APE). Thermo elastic: " in text
    assert "; to meet it, take error_budget.sources.thermo_elastic.size = " in text


def test_the_limit_that_is_advised_meets_the_requirement(missed):
    (drift,) = budget_lines(missed)
    said = contributors.advice(missed, drift).partition(" = ")[2].partition(" or less")[0]
    again = loaded(*MISSED, ('size = "1.5 urad"', f'size = "{said.replace("µ", "u")}"'))
    asked = study.error_budget.of_mission(again.mission.error_budget, again.sources)
    (found,) = study.pointing_errors(asked, None).judged
    assert found.total.holds
    assert found.total.quantile_rad == pytest.approx(2e-6, rel=0.02)  # rounded to three digits


@pytest.mark.usefixtures("undrawn")
def test_a_run_ends_with_1_where_a_limit_is_missed_and_can_be_run_again(call, folder, monkeypatch):
    monkeypatch.setattr(paper, "applies", lambda mission: False)
    (folder / "m.toml").write_text(mission_text(*MISSED), "utf-8")
    code, out, _ = call("run", "m.toml", "--json")
    found = json.loads(out)
    assert (code, found["met"], found["closes"]) == (1, False, True)
    _, out, _ = call("pointing", "m.toml", "--json")
    assert found["error_budget"] == json.loads(out)["budget"]
    code, out, _ = call("reproduce", "m-study")
    assert (code, "nothing differs" in out) == (0, True), out


def test_a_mission_without_the_table_has_none_of_it():
    found = plain_study()
    assert found.error_budget is None
    assert "error_budget" not in summary(found)
    assert budget_lines(found) == []
    assert all("error budget" not in line for stage in chain.stages(found) for line in stage.lines)


@pytest.mark.promise("pointing-47")
def test_the_loop_is_that_of_the_judged_controller_and_is_not_designed_again(monkeypatch):
    monkeypatch.setattr(controller_study, "design", None)
    found, fine = looped_study(), whole_study()[0].fine_pointing
    by_source = fine.best.theory.error_by_source
    drift = next(each for each in found.error_budget.judged if each.name == "drift")  # an APE about y
    own = {share.name: share for share in drift.shares if share.contribution.kind == "loop"}
    assert set(own) == set(by_source)
    for name, share in own.items():
        assert share.sigma_rad[0] ** 2 == pytest.approx(by_source[name][1], rel=1e-6, abs=1e-30)
        assert share.contribution.origin.endswith(f"under {fine.best.design.name}")
    left = math.fsum(share.sigma_rad[0] ** 2 for share in own.values())
    assert left == pytest.approx(fine.best.theory.error[1], rel=1e-6)


def test_what_weighs_most_may_be_of_the_loop():
    found = looped_study()
    word, _ = budget_lines(found)
    said, todo = contributors.contributor(found, word), contributors.advice(found, word)
    assert said.startswith("Vibration (OLYMPUS): ")
    assert "fine_pointing.rate" in todo
    assert budget_data(found.error_budget) == report.summary(found)["error_budget"]


@pytest.mark.parametrize(("of_the_ratio", "warned"), [(0.99, True), (1.01, False)])
def test_a_loop_that_leaves_far_more_than_its_theory_says_is_warned_of(monkeypatch, of_the_ratio, warned):
    found = looped_study()
    best = found.fine_pointing.best
    ratio = best.simulated[Variant.GIVEN].rms_rad / best.theory.radial_rms_rad
    monkeypatch.setattr(words, "PROMISE", of_the_ratio * ratio)
    said = f"the error budget takes the loop by its linear theory; simulated, it leaves {ratio:.2f} times as much rms"
    assert (said in words.ranked_warnings(found)["The loop that is judged"]) is warned


def test_a_requirement_on_an_unknown_loop_is_not_met():
    found = looped_study()
    scene = found.fine_pointing.scene
    table = replace(scene.mirrors, table=scene.mirrors.table.model_copy(update={"linear": None}))
    fine = replace(found.fine_pointing, scene=replace(scene, mirrors=table))
    for line in verdict.of_error_budget(found.error_budget, {}, fine):
        assert (line.met, line.unknown != "") == (False, True)
        assert line.unknown != IMPOSSIBLE
