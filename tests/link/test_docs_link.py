"""docs/link.md: its examples print what stands below them, and the figures of its words are computed anew."""

import math
import re
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq

from microrad import link
from microrad.link import gains, pointing, requirement
from microrad.link import study as link_study
from microrad.loop import paper_cases
from microrad.mission.file import load_link, load_mission
from microrad.mission.tables.link import BeamShape
from places import ROOT
from preset_files import completed
from scenes import cases_of

PAGE = (ROOT / "docs" / "link.md").read_text(encoding="utf-8")
SAID = " ".join(re.sub(r" *<!-- promise: link-\d+ -->", "", PAGE).split())
EVEN = BeamShape.model_validate({"profile": "uniform"})
BEST = BeamShape.model_validate({"profile": "gaussian", "radius": f"{25.0 / 1.1209!r} mm", "m_squared": 1.0})


def told(*sentences):
    """These words stand on the page, wherever its lines break."""
    for sentence in sentences:
        assert sentence in SAID, sentence


@pytest.fixture(scope="module")
def paper():
    return link_study.run_link_study(load_link(ROOT / "missions" / "paper.toml"))


def changed(m, **values):
    """A mission with values by their dotted keys, underscores twice for dots."""
    for key, value in values.items():
        m = m.with_value(key.replace("__", "."), value)
    return m


def margin_db(m, **at):
    return link.communication_budget(link.of(m), {}, **at).margin_db


@pytest.mark.promise(
    "link-11",
    "link-19",
    "link-21",
    "link-28",
    "link-36",
    "link-41",
    "link-43",
    "link-51",
    "link-56",
    "link-58",
    "link-96",
    "link-107",
    "link-76",
    "link-83",
    "link-89",
)
def test_every_example_prints_what_stands_below_it(monkeypatch, capsys):
    monkeypatch.chdir(ROOT)
    examples = re.findall(r"```python\n(.*?)```\n\n```text\n(.*?)```", PAGE, flags=re.DOTALL)
    assert len(examples) == PAGE.count("```python") > 9
    assert len(examples) == PAGE.count("```python") == 15
    session: dict[str, object] = {}
    for code, printed in examples:
        exec(code, session)
        assert capsys.readouterr().out == printed


@pytest.mark.promise("link-12", "readme-35")
def test_each_convention_costs_what_its_row_says(paper):
    """The row of a loss at both ends is held by test_link_conventions.py."""
    m = paper.file.mission
    told(f'| `pointing_loss = "gaussian"`, that of the preset | {margin_db(m):.2f} dB |')
    told(
        f'| `"gain"`: exp(-G theta^2), GEO on axis | {margin_db(changed(m, conventions__pointing_loss="gain")):.2f} dB'
    )
    lit = changed(m, conventions__pointing_loss="pattern")
    told(f'| `"pattern"`, aperture lit evenly | {margin_db(changed(lit, communication__beam=EVEN)):.2f} dB |')
    cut = changed(lit, communication__beam=BEST)
    own, best = link.of(m).beam, link.of(cut).beam
    less_gain, less_loss = own.gain_db - best.gain_db, float(own.fall.loss_db(1e-5) - best.fall.loss_db(1e-5))
    told(
        f"D/2 = 1.1209 radii | {margin_db(cut):.2f} dB | {less_gain:.2f} dB less gain, {less_loss:.2f} dB less pointing"
    )
    ratio = changed(m, conventions__strehl="ratio")
    lost = gains.strehl_loss_db(0.4, "ratio")
    told(f'the paper\'s "0.4 dB" read as 0.4 | {margin_db(ratio):.2f} dB | {lost:.2f} dB in place of 0.40 dB |')
    wide = link.beam_budget(
        "beacon", link.Shared.of(half := changed(m, conventions__divergence="half-1/e2")), half.beacon, {}
    )
    was = paper.beacon.margin_db
    told(f'`divergence = "half-1/e2"`, the beacon\'s margin | {wide.margin_db:.2f} dB, was {was:.2f} |')


@pytest.mark.promise("link-12", "readme-35")
def test_a_residual_read_as_radial_costs_what_its_row_says():
    m = load_mission(ROOT / "missions" / "paper.toml").mission
    worst = paper_cases.worst(paper_cases.sine_runs(cases_of(m)), m.requirement.residual_statistic)
    left = paper_cases.residual_rad(m.requirement, m.conventions, worst.trace)
    radial = paper_cases.residual_rad(
        m.requirement, m.conventions.model_copy(update={"residual": "radial"}), worst.trace
    )
    assert radial == pytest.approx(math.sqrt(2.0) * left)
    margins = [float(link.margin_of_error(link.of(m), error)) for error in (radial, left)]
    told(f'| `residual = "radial"`, at the {left * 1e6:.1f} µrad that `microrad run` simulates')
    told(f"simulates | {margins[0]:.2f} dB, was {margins[1]:.2f} |")


@pytest.mark.promise("link-13")
def test_on_which_side_the_mixture_is(paper):
    m = paper.file.mission
    lit = changed(m, conventions__pointing_loss="pattern")
    even, cut = (changed(lit, communication__beam=each) for each in (EVEN, BEST))

    def more_db(other, error_rad):
        return margin_db(other, pointing_error_rad=error_rad) - margin_db(m, pointing_error_rad=error_rad)

    told(f"by {more_db(even, 10e-6):.2f} dB against even light and {more_db(cut, 10e-6):.2f} dB against the best cut")
    turn = brentq(lambda error: more_db(cut, error), 1e-6, 10e-6)
    told(f"it is so only beyond {turn * 1e6:.1f} µrad; on the axis it promises {-more_db(cut, 0.0):.2f} dB too much")


@pytest.mark.promise("link-32")
def test_each_rule_comes_to_what_its_row_says(paper):
    totals = {each.rule: each.total_rad * 1e6 for each in paper.open_loop.summations}
    titles = {
        "rss": "root sum square",
        "esa-1993": "class by class (ESA 1993)",
        "ecss-axis": "ECSS, one axis",
        "ecss-radial": "ECSS, two axes",
        "rayleigh": "ECSS, two like axes (Rayleigh)",
        "exact": "radial distribution",
    }
    assert totals.keys() == titles.keys() and paper.file.mission.pointing.confidence == 0.997
    for rule, title in titles.items():
        told(f"| {title} | {totals[rule]:.0f} µrad |")
    by_rule = {each.rule: each for each in paper.open_loop.summations}
    assert "the paper" in by_rule["rss"].authority and by_rule["rss"].caveat.startswith("not authorised")
    assert "4.2.4.2.2" in by_rule["rayleigh"].authority and by_rule["rayleigh"].caveat


@pytest.mark.promise("link-33")
def test_what_the_beacon_covers(paper):
    m = paper.file.mission
    over_all = pointing.open_loop_budget(m.pointing, link.Shared.of(m), m.beacon, {}, interpretation="mixed")
    told(f"its partner with a probability of {paper.open_loop.reading.coverage:.2f} only")
    told(f"both biases at their bounds ({over_all.reading.coverage:.2f} over all satellites)")
    row = requirement.of_beams(link_study.run_link_study(load_link(ROOT / "missions" / "leo-geo.toml")))[0]
    assert (row.name, row.mark) == ("beacon covers its partner", "PASS")
    told(f"The shipped mission asks for {row.required:.0f} % in one attempt", f"and has {row.actual:.1f} %.")
    own = requirement.of_beams(paper)[0]
    assert (own.name, own.mark) == ("beacon cone over the root sum square", "derived")


@pytest.mark.promise("link-44")
def test_what_point_ahead_costs(paper):
    effect = paper.point_ahead
    told(f"at most {effect.angle_rad * 1e6:.0f} µrad here: {effect.beam_half_angles:.1f} half angles of the comm")
    told(f"Left out, it would cost {effect.loss_db:.0f} dB", f"needs {effect.mirror_range_rad * 1e6:.0f} µrad of range")
    m = changed(paper.file.mission, point_ahead__corrected=False)
    beacon = link.beam_budget("beacon", link.Shared.of(m), m.beacon, {})
    told(f"(the beacon's margin falls from {paper.beacon.margin_db:.2f} to {beacon.margin_db:.2f} dB)")


@pytest.mark.promise("link-47", "link-49", "link-50", "link-52", "link-53")
def test_figures_of_acquisition(paper):
    found, trade = paper.finding, paper.finding.trade
    told(f"(here {found.beacon_radius_rad * 1e6:.0f} µrad for the beacon, more than its 1/e2 angle;")
    assert found.beacon_radius_rad > paper.file.mission.beacon.divergence_rad / 2.0
    told(f"the predicted direction ({found.sigma_rad * 1e6:.0f} µrad per axis here)")
    told(f"diffraction at the aperture ({found.scanned.half_angle_rad * 1e6:.1f} µrad for 5 cm)")
    assert paper.file.mission.acquisition.attempts == 5
    last = [max(way.outcome.locked.time_s.max(), way.outcome.lost.time_s.max()) for way in found.ways]
    told(f"has ended after {last[0]:.0f} s by the beacon and {last[1]:.0f} s by the scan, within the about 100 s")
    assert min(way.outcome.success_probability for way in found.ways) > 0.99
    settling = [stage.duration_s for stage in found.wide.stages]
    assert settling[0] > 0.5 * sum(settling)
    faster = trade.wide_time_s < trade.scan_mean_time_s
    assert np.all(faster) and trade.wide_time_s[-1] > 0.9 * trade.scan_mean_time_s[-1]  # that of 1 mrad is the last
    assert trade.sigma_rad[-1] == pytest.approx(1e-3)
    told("near 1 mrad per axis here", f"covers with a probability of {trade.wide_probability[-1]:g}")
    told(f"one scan finds {found.scan.stages[2].success_probability:.2f} of the partners, since 5 µrad of jitter open")
    m = changed(paper.file.mission, acquisition__scan__jitter_rms_rad=0.0)
    without = link_study.run_link_study(replace(paper.file, mission=m)).finding.scan
    told(f"gaps between its tracks ({without.stages[2].success_probability:.3f} without jitter)")


@pytest.mark.promise("link-57")
def test_the_cut_of_luce_s_beam_is_left_out_of_its_optics(tmp_path):
    """The transmission that the measurement implies, less what the aperture cuts: that is in its gain."""
    m = completed(tmp_path, "oicets-artemis").mission
    implied = -gains.implied_transmission_db(measured_w_sr=560e6, power_w=0.09, half_angle_rad=4.7e-6)
    beam = link.of(m).beam
    cut = gains.gaussian_beam_gain_db(m.communication.wavelength_m / (math.pi * m.communication.beam.radius_m))
    cut -= beam.gain_db
    told(f"less the {cut:.2f} dB that the cut of the beam at the aperture accounts for")
    assert m.communication.transmit_optics_loss_db == pytest.approx(implied - cut, abs=0.006)
