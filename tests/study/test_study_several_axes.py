"""A whole run whose fine-pointing loop has a mirror of several axes: residual, budget, stroke, contact, report."""

import math
import re
import shutil
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from tempfile import mkdtemp

import numpy as np
import pytest
from numpy.testing import assert_allclose

from budget_files import loaded
from campaign_files import HEAD, POWER
from microrad import link, mirror, report
from microrad.campaign.file import load_campaign
from microrad.campaign.rows.loops import mission_loop
from microrad.loop import coupled_study, paper_cases
from microrad.loop.pointing_loop import ensemble
from microrad.loop.pointing_loop.loop import decoupling
from microrad.mirror import Variant, coupled
from microrad.mission.file import MissionError, load_loop, load_mission
from microrad.orbit.day import assumptions
from microrad.report.results.reproduce import reproduce
from microrad.studio.views import controllers
from microrad.study import study
from places import ROOT
from several_axes import TEXT, mission_text, three_actuators
from shipped import SHIPPED, without_fine_pointing

NAMED = ("[fine_pointing]\n", '[fine_pointing]\nmirror_file = "mirror.toml"\n')
SHORT = (
    ('duration = "2 s" ', 'duration = "0.6 s" '),
    ('settle = "0.5 s"', 'settle = "0.2 s"'),
    ("runs = 4000 ", "runs = 100 "),
)


def written(folder, mirror=TEXT, *changes):
    (folder / "mirror.toml").write_text(mirror, encoding="utf-8")
    (folder / "mission.toml").write_text(mission_text(NAMED, *SHORT, *changes), encoding="utf-8")
    return folder / "mission.toml"


@cache
def plate_study():
    """The study of a plate on three actuators under PI, and the folder of its mission."""
    folder = Path(mkdtemp())
    path = written(folder, coupled.text(three_actuators()))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(coupled_study.designs, "names", lambda table: ("PI",))
        return study.run_study(load_mission(path)), folder


@cache
def plate_page():
    """The report of that study."""
    return report.write(plate_study()[0], plate_study()[1] / "out")


@pytest.fixture(scope="module", autouse=True)
def _without_scan_and_removed():
    """The paper's scan and most assumptions of the day have tests of their own, and no part in the loop here."""
    every = assumptions._changes
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(study.paper, "applies", lambda mission: False)
        patch.setattr(assumptions, "_changes", lambda *args: list(every(*args))[::5])
        yield
    if plate_study.cache_info().currsize:
        shutil.rmtree(plate_study()[1])


@pytest.mark.promise("mirror-file-30")
@pytest.mark.promise("pointing-76", "pointing-77")
def test_the_loop_is_that_of_the_named_mirror():
    fine = plate_study()[0].fine_pointing
    assert isinstance(fine.scene, coupled_study.CoupledScene)
    assert fine.scene.loop.mirror.name == "a plate"
    assert [v.design.name for v in fine.verified] == ["PI"]
    assert set(fine.best.simulated) == {Variant.GIVEN, Variant.STRAIGHT}


def test_a_budget_of_pointing_errors_takes_what_that_loop_leaves():
    fine = plate_study()[0].fine_pointing
    file = loaded(whole=True)  # the paper's mission with a budget; its table is all that counts here
    asked = study.error_budget.of_mission(file.mission.error_budget, file.sources)
    found = study.pointing_errors(asked, fine)
    drift = next(each for each in found.judged if each.name == "drift")  # an APE about y
    left = math.fsum(share.sigma_rad[0] ** 2 for share in drift.shares if share.contribution.kind == "loop")
    assert_allclose(left, fine.best.theory.error[1], rtol=1e-6)


def test_without_hysteresis_the_simulation_is_the_theory():
    (only,) = plate_study()[0].fine_pointing.verified
    assert_allclose(only.simulated[Variant.STRAIGHT].rms_rad, only.theory.radial_rms_rad, rtol=0.1)
    bound = plate_study()[0].fine_pointing.optimum_rad
    assert 0.1 * only.theory.radial_rms_rad < bound <= 1.01 * only.theory.radial_rms_rad


@pytest.mark.promise("pointing-77")
def test_the_papers_sines_keep_their_mirror_and_the_verdict_is_the_links_under_the_best_controller():
    found = plate_study()[0]
    m, fine = found.file.mission, found.fine_pointing
    assert {run.mirror for run in found.runs} >= {"given"}
    cases = paper_cases.of(m, mirror.of(m))
    peaks = {(r.controller, r.freq_hz): r.trace.peak_rad for r in paper_cases.sine_runs(cases) if r.mirror == "given"}
    assert {(r.controller, r.freq_hz): r.trace.peak_rad for r in found.runs if r.mirror == "given"} == peaks
    (line,) = (r for r in found.requirements if r.name.startswith("link margin for"))
    (own,) = (r for r in found.requirements if r.name.startswith("fine pointing at"))
    left = fine.best.simulated[Variant.GIVEN].quantile_rad
    assert own.actual == left != fine.best.simulated[Variant.STRAIGHT].quantile_rad
    assert_allclose(line.actual, link.margin_of_error(link.of(m), left), rtol=1e-12)
    volts = (m.amplifier.output_min_v / m.amplifier.gain, m.amplifier.output_max_v / m.amplifier.gain)
    assert_allclose(fine.scene.reach_v, np.array(volts) - 50.0, rtol=1e-12)


@pytest.mark.promise("pointing-77")
def test_the_parts_of_the_error_make_up_the_whole():
    budget = plate_study()[0].fine_pointing.budget
    assert_allclose(budget.combined_rad, budget.together_rad, rtol=0.1)
    (vibration,) = (part for part in budget.parts if part.name == "OLYMPUS")
    assert_allclose(vibration.rms_rad, vibration.theory_rad, rtol=0.1)


@pytest.mark.promise("pointing-77", "pointing-82")
def test_the_stroke_is_that_of_each_actuator():
    """Drives by the least norm beside a piston of 0, from the mirror's own slow gain."""
    found = plate_study()[0]
    scene, m = found.fine_pointing.scene, found.file.mission
    low, high = scene.reach_v
    f = m.fine_pointing
    body = f.body.error_rad / (math.sqrt(2.0) if f.body.convention == "radial" else 1.0)
    lag = f.reference.line_of_sight_rate_rad_s * (1.0 - f.reference.rate_feedforward)
    lag /= 2.0 * math.pi * f.body.bandwidth_hz
    ahead = f.reference.point_ahead_rad if f.reference.point_ahead_on_mirror else 0.0
    demand = np.array([body + ahead + m.pointing.bias_rad + lag, body + m.pointing.bias_rad])
    per_volt = (
        scene.rest.optics
        @ -(scene.rest.mirror.C @ np.linalg.solve(scene.rest.mirror.A, scene.rest.mirror.B))
        @ decoupling(scene.rest)
    )
    assert_allclose(per_volt, per_volt[0, 0] * np.eye(2), atol=1e-9 * per_volt[0, 0])
    volts = np.abs(decoupling(scene.rest)) / per_volt[0, 0] @ demand
    shares = [axis.needed_rad / axis.available_rad for axis in scene.own_stroke]
    assert_allclose(shares, volts / min(-low, high), rtol=1e-9)
    (stroke,) = (r for r in found.requirements if r.subject == "stroke")
    assert_allclose(stroke.required / stroke.actual, max(shares), rtol=1e-9)


@pytest.mark.promise("pointing-77")
def test_the_contact_flies_that_loop():
    """Its windows leave what the ensemble leaves, and the mirror follows reference and body."""
    found = plate_study()[0]
    (only,) = found.fine_pointing.verified
    squares = [w.rms_rad**2 for w in found.contact.windows]
    assert_allclose(math.sqrt(np.mean(squares)), only.simulated[Variant.GIVEN].rms_rad, rtol=0.3)
    body = found.file.mission.fine_pointing.body.error_rad
    for window in found.contact.windows:  # beside the reference, the mirror takes off what the body strays by
        assert abs(window.mirror_rad[0] - window.point_ahead_rad) < 2.0 * body
        assert abs(window.mirror_rad[1]) < 2.0 * body


@pytest.mark.promise("mirror-file-30")
@pytest.mark.usefixtures("undrawn")
def test_the_report_says_which_mirror_flies():
    page = plate_page().read_text(encoding="utf-8")
    assert page.count("a plate, 3 actuators, 3 outputs, 6 states, 3 hysteresis elements") == 2
    assert "stroke for the worst case (actuator" in page
    assert "Against PI (" in page
    assert "gain grid" not in page
    assert "Bandwidth: lowest frequency" in page and "Crossover" not in page  # whose column is empty
    assert "what the disk margin allows both axes to change by" in page


@contextmanager
def taken_away(path):
    text = path.read_text(encoding="utf-8")
    path.unlink()
    try:
        yield
    finally:
        path.write_text(text, encoding="utf-8")


@pytest.mark.usefixtures("undrawn")
def test_a_report_runs_again_from_the_mirror_that_it_carries(monkeypatch):
    """What runs again has that mirror; its numbers are those of before."""
    (found, folder), carried = plate_study(), []
    own = load_loop(folder / "mission.toml")[1]

    def run(file, on_progress):
        carried.append(load_loop(file.path)[1])
        return found

    page = plate_page()
    monkeypatch.setattr(study, "run_study", run)
    with taken_away(folder / "mirror.toml"):
        again = reproduce(page)
    assert carried == [own] and own is not None
    assert again.same


@pytest.mark.endurance
def test_a_report_of_several_axes_has_the_same_numbers_when_it_runs_again(tmp_path, monkeypatch):
    monkeypatch.setattr(coupled_study.designs, "names", lambda table: ("PI",))
    found, folder = plate_study()
    page = report.write(found, tmp_path / "out")
    with taken_away(folder / "mirror.toml"):
        assert reproduce(page).same


@pytest.mark.promise("mirror-file-30")
@pytest.mark.promise("pointing-77")
def test_a_campaign_flies_that_loop(tmp_path, monkeypatch):
    """A row is the ensemble of the mission's loop under the controller that is tuned for it."""
    written(tmp_path, coupled.text(three_actuators()))
    own = mission_loop(load_mission(tmp_path / "mission.toml"), campaign_of(tmp_path).table.loop, 1)
    controller = own.controller(own.tuned())
    (designed,) = coupled_study.design(own.scene, only=("PI",)).made
    assert_allclose(controller.system.A, designed.controller.system.A, rtol=0.0)
    assert own.row is own.scene.loop
    left = ensemble.simulate(own.row, controller, own.span, 8)
    assert_allclose(left.axis_rms_rad, designed.residual_rad, rtol=0.2)


def campaign_of(folder, *lines):
    loop = "\n".join(("[loop]", 'controller = "PI"', 'duration = "0.5 s"', *lines))
    (folder / "campaign.toml").write_text(f"{HEAD}{loop}\n{POWER}", encoding="utf-8")
    return load_campaign(folder / "campaign.toml")


@pytest.mark.parametrize(
    ("line", "key"),
    [('axes = "one"', "loop.axes"), ('mirror = "comparison"', "loop.mirror"), ('controller = "PI + inverse"', "")],
)
def test_a_campaign_refuses_what_is_for_a_mirror_on_each_axis(tmp_path, line, key):
    written(tmp_path, coupled.text(three_actuators()))
    key, lines = key or "loop.controller", [line]
    if key == "loop.controller":
        text = f"{HEAD}[loop]\n{line}\n{POWER}"
        (tmp_path / "campaign.toml").write_text(text, encoding="utf-8")
        with pytest.raises(MissionError) as caught:
            load_campaign(tmp_path / "campaign.toml")
    else:
        with pytest.raises(MissionError) as caught:
            campaign_of(tmp_path, *lines)
    assert [fault.key for fault in caught.value.faults] == [key]


@pytest.mark.promise("pointing-76")
def test_a_mission_and_an_option_name_the_same_mirror(tmp_path):
    named, table = load_loop(written(tmp_path))
    (tmp_path / "plain.toml").write_text(mission_text(*SHORT), encoding="utf-8")
    plain, given = load_loop(tmp_path / "plain.toml", tmp_path / "mirror.toml")
    assert load_loop(tmp_path / "plain.toml")[1] is None
    assert table == given
    assert named.mission.fine_pointing.mirror_file == "mirror.toml"
    assert plain.mission.fine_pointing.mirror_file is None


@pytest.mark.parametrize(
    ("mirror", "said"),
    [
        (None, "does not exist\n.*expected: an existing file; `microrad identify` writes one"),
        ('name = "one"\ntravel = "2 mrad"\n', "a mirror of one axis"),
        pytest.param("version = 2\n", "is missing", marks=pytest.mark.endurance),
    ],
)
def test_a_mirror_file_that_is_none_of_several_axes_is_refused(tmp_path, mirror, said):
    path = written(tmp_path)
    if mirror is None:
        (tmp_path / "mirror.toml").unlink()
    else:
        (tmp_path / "mirror.toml").write_text(mirror, encoding="utf-8")
    with pytest.raises(MissionError, match=said):
        study.run_study(load_mission(path))


@pytest.mark.promise("mirror-file-31")
def test_the_studio_says_where_its_controllers_are(tmp_path):
    with pytest.raises(ValueError, match="microrad design has its controllers"):
        controllers.controller(load_mission(written(tmp_path)), "PI")
    alone = tmp_path / "alone.toml"
    alone.write_text(without_fine_pointing(SHIPPED.read_text("utf-8")), "utf-8")
    with pytest.raises(ValueError, match=r"the mission has no table \[fine_pointing\]: microrad init writes one"):
        controllers.controller(load_mission(alone), "PI")


def test_a_mirror_of_one_axis_in_an_option_leaves_the_loop_its_own(tmp_path):
    named, table = load_loop(written(tmp_path))
    page = (ROOT / "docs" / "mirror-file.md").read_text(encoding="utf-8")
    (tmp_path / "one.toml").write_text(re.search(r"```toml\n(.*?)```", page, re.DOTALL).group(1), encoding="utf-8")
    one, kept = load_loop(named.path, tmp_path / "one.toml")
    assert table is not None and kept == table
    assert one.mission.mirror != named.mission.mirror
