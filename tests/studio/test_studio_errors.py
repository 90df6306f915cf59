"""What the studio's page of pointing shows of the budget of errors: the report's view, which follows the draft."""

from types import SimpleNamespace

import pytest

import several_axes
from budget_files import KEPT, TABLE, kept_study, mission_text
from microrad.report.error_budget.page import budget_view
from microrad.report.view import views_text
from microrad.studio.draft.draft import Draft
from microrad.studio.views import errors, pointing
from microrad.studio.views.plots import drawn
from shipped import SHIPPED, links_alone

LOOP = TABLE.replace("with_loop = false", "with_loop = true")


def opened(folder, text):
    path = folder / "mission.toml"
    path.write_text(text, "utf-8")
    return Draft.open(path)


def shown(draft):
    file = draft.link()
    return errors.view(file, file.mission.error_budget)


@pytest.mark.promise("decisions-1")
@pytest.mark.promise("studio-12", "studio-13")
def test_the_page_has_the_view_of_the_report(tmp_path):
    view = shown(opened(tmp_path, mission_text(*KEPT)))
    assert views_text([view], 100) == views_text([budget_view(kept_study().error_budget)], 100)
    figures = drawn(view.blocks)
    assert [*figures] == ["pointing-errors-contributions", "pointing-errors-distribution"]
    assert all(figure["data"] for figure in figures.values())


@pytest.mark.endurance
def test_sizes_and_limits_have_sliders_that_move_it(tmp_path, monkeypatch):
    monkeypatch.setattr(errors, "budget_figures", lambda found, stacked: ())
    draft = opened(tmp_path, mission_text(*KEPT))
    sliders = pointing.sliders(draft)
    assert [each.label for each in sliders["Sources"]] == ["Alignment", "Thermo elastic"]
    assert [each.label for each in sliders["Limits"]] == ["Code word", "Drift"]
    rows = shown(draft).blocks[0].rows
    again = draft.set(sliders["Sources"][1].key, "4 urad").set(sliders["Limits"][0].key, "5 urad")
    moved = shown(again).blocks[0].rows
    assert float(str(moved[1][3]).split()[0]) > float(str(rows[1][3]).split()[0])
    assert (rows[1][3].mark, moved[1][3].mark) == ("PASS", "FAIL")
    assert (rows[0][4], moved[0][4]) == ("4.00", "5.00")


@pytest.mark.promise("studio-12")
def test_the_loop_is_a_source_under_the_controller_that_pointing_takes(tmp_path):
    view = shown(opened(tmp_path, SHIPPED.read_text("utf-8") + LOOP))
    origins = {row[-1] for row in view.blocks[1].rows}
    assert "the mission's fine-pointing loop under PI" in origins
    assert "microrad run takes the best controller" in views_text([view], 500)
    assert "pointing-errors-spectrum" in drawn(view.blocks)


def test_a_loop_that_is_not_there_or_of_several_axes_is_refused(tmp_path):
    with pytest.raises(ValueError, match="with_loop is true, and the mission has no mirror and no loop"):
        shown(opened(tmp_path, links_alone(SHIPPED.read_text("utf-8")) + LOOP))
    (tmp_path / "two-axes.toml").write_text(several_axes.TEXT, "utf-8")
    named = several_axes.mission_text(("[fine_pointing]", '[fine_pointing]\nmirror_file = "two-axes.toml"'))
    with pytest.raises(ValueError, match="several axes: microrad run has the budget"):
        shown(opened(tmp_path, named + LOOP))


def judged(monkeypatch, with_loop):
    """Stands in for the budget of errors: what its parts are asked for."""
    asked = []
    monkeypatch.setattr(
        errors.assembly, "of_mission", lambda *given: asked.append(given) or SimpleNamespace(with_loop=with_loop)
    )
    monkeypatch.setattr(errors.assembly, "judge", lambda of, loop: asked.append((of.with_loop, loop)) or "found")
    monkeypatch.setattr(errors, "budget_figures", lambda found, stacked: f"figures of {found}, {stacked}")
    monkeypatch.setattr(errors, "budget_view", lambda *given: given)
    monkeypatch.setattr(errors, "_closed", lambda file: f"loop of {file.sources}")
    return asked


@pytest.mark.parametrize("with_loop", [False, True])
def test_a_budget_has_a_loop_and_says_under_which_controller_where_it_asks_for_one(monkeypatch, with_loop):
    asked = judged(monkeypatch, with_loop)
    found, figures, said = errors.view(SimpleNamespace(sources="sources"), "table")
    assert asked == [("table", "sources"), (with_loop, "loop of sources" if with_loop else None)]
    words = "The loop is under PI here; microrad run takes the best controller of its study."
    assert (found, figures, said) == ("found", "figures of found, True", [words] * with_loop)


def test_the_loop_of_a_budget_is_closed_with_the_light_and_arrival_of_its_own_links(monkeypatch, tmp_path):
    file = opened(tmp_path, SHIPPED.read_text("utf-8")).file()
    asked = []

    class Kept:
        def part(self, make, scene):
            asked.append(("kept", make is errors._designed))
            return make(scene)

    def design(scene, only):
        asked.append((scene.theory, only))
        return [SimpleNamespace(controller="the controller")]

    monkeypatch.setattr(errors, "mirror_of_loop", lambda file: None)
    monkeypatch.setattr(errors.mirror, "of", lambda mission: ("mirror", mission is file.mission))
    monkeypatch.setattr(errors.link, "tracking_light_w", lambda of: ("light", of is file))
    monkeypatch.setattr(errors.link, "arrival_of", lambda of: ("arrival", of is file))
    monkeypatch.setattr(
        errors.controller_study, "scene", lambda *given: asked.append(given[1:]) or SimpleNamespace(theory="theory")
    )
    monkeypatch.setattr(errors.controller_study, "design", design)
    monkeypatch.setattr(errors.kept, "of_user", Kept)
    monkeypatch.setattr(errors, "close", lambda theory, controller: f"{theory} under {controller}")
    assert errors._closed(file) == "theory under the controller"
    assert asked == [(("mirror", True), ("light", True), ("arrival", True)), ("kept", True), ("theory", ["PI"])]


def test_a_loop_that_cannot_be_a_source_is_refused_with_the_reason(monkeypatch):
    with pytest.raises(ValueError, match="no mirror") as refusal:
        errors._closed(SimpleNamespace())
    assert str(refusal.value) == (
        "error_budget.with_loop is true, and the mission has no mirror and no loop to be a source"
    )
    monkeypatch.setattr(errors, "mirror_of_loop", lambda file: "two.toml")
    with pytest.raises(ValueError, match="several axes") as refusal:
        errors._closed(object.__new__(errors.MissionFile))
    assert str(refusal.value) == (
        "the loop's mirror has several axes: microrad run has the budget with what that loop leaves"
    )
