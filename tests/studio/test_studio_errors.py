"""What the studio's page of pointing shows of the budget of errors: the report's view, which follows the draft."""

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


def test_sizes_and_limits_have_sliders_that_move_it(tmp_path):
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
