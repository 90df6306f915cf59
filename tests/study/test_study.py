"""The whole study: requirements, claims and margins of the shipped mission, and of missions that differ from it."""

import math
import re
from dataclasses import replace
from math import log10, pi
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from microrad.link.requirement import IMPOSSIBLE
from microrad.loop import sine_run as simulate
from microrad.mirror.summary import summarise, unknown_dynamics
from microrad.mission.file import load_mission
from microrad.orbit import day as day_study
from microrad.report.fine_pointing.words import not_reliable
from microrad.report.links.views import performance_table
from microrad.report.links.words import consequences
from microrad.report.paper import figures
from microrad.report.study import chain, words
from microrad.report.study import contributors as requirement_views
from microrad.report.study.data import summary
from microrad.report.study.words import headline
from microrad.study import paper, study, verdict
from scenes import scene_of
from shipped import DEFAULT, SHIPPED, edited_file, whole_study


@pytest.fixture(scope="module")
def coarse():
    """Four points are enough of a scan here; the whole grid has tests of its own."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(paper, "PROPORTIONAL_V_MRAD", (1.0,))
        patch.setattr(paper, "INTEGRAL_V_MRAD_S", (8e3, 16e3))
        yield


@pytest.fixture(scope="module")
def shipped():
    """The study of the shipped mission, and what it said of its progress."""
    return whole_study()


@pytest.fixture(scope="module")
def dayless(tmp_path_factory):
    """The study of the shipped mission without its day and its fine-pointing loop."""
    return study.run_study(edited_file(tmp_path_factory.mktemp("dayless"), day=False))


@pytest.fixture
def variant(coarse, monkeypatch, tmp_path):
    """The study of the shipped mission with pieces of its text replaced, without a scan and without its day."""
    monkeypatch.setattr(paper, "applies", lambda mission: False)
    return lambda *changes: study.run_study(edited_file(tmp_path, *changes, day=False))


def requirement(result, name):
    rows = (*result.requirements, *result.papers_loop)
    (line,) = [r for r in rows if r.name.lower().startswith(name)]
    return line


def peaks(result, which="given"):
    return {(r.controller, r.freq_hz): r.trace.peak_rad for r in result.runs if r.mirror == which}


# ------------------------------------------------------------------------------------------------ the shipped mission


def test_the_shipped_mission_closes(shipped):
    result, _ = shipped
    assert result.closes is True
    assert_allclose(result.communication.margin_db, 3.0, atol=0.01)
    assert result.beacon.margin_db > 0 < result.answer.margin_db


@pytest.mark.promise("readme-21", "report-8")
def test_the_achieved_margin_is_at_the_worst_residual(shipped):
    """Gaussian pointing loss 8.686 (theta / theta_d)^2 dB with theta_d = lambda / (pi D / 2)."""
    result, _ = shipped
    residual = result.residual.trace.peak_rad
    assert (result.residual.mirror, result.residual.controller, result.residual.freq_hz) == (
        "given",
        "PID + inverse",
        25.0,
    )
    assert residual == max(peak for (controller, _), peak in peaks(result).items() if controller == "PID + inverse")
    half_angle = 1.55e-6 / (pi * 0.025)
    loss = 20 * log10(np.e) * (residual**2 - (10e-6) ** 2) / half_angle**2
    assert_allclose(result.achieved.margin_db, result.communication.margin_db - loss, atol=1e-9)
    assert 1.0 < result.achieved.margin_db < 3.0
    compared = result.comparison
    assert compared.residual.mirror == "comparison"
    loss = 20 * log10(np.e) * (compared.residual.trace.peak_rad**2 - (10e-6) ** 2) / half_angle**2
    assert_allclose(compared.margin_db, result.communication.margin_db - loss, atol=1e-9)
    assert compared.margin_db > 4.0


@pytest.mark.promise("report-8")
def test_the_lines_of_the_verdict(shipped):
    result, _ = shipped
    *beams, stroke, fine, margin = result.requirements
    rows = (*beams, *result.papers_loop, stroke, fine, margin)
    assert (len(beams), len(result.papers_loop)) == (3, 2)
    found = [(r.unit, r.met, r.limited_by) for r in rows]
    cause = "hysteresis at 25 Hz, whose model first turns the wrong way"
    assert found == [
        ("rad", True, "Body pointing"),
        ("dB", True, "Pointing loss"),
        ("dB", True, "Pointing loss"),
        ("rad", False, cause),
        ("dB", False, found[4][2]),
        ("rad", False, "Body pointing"),
        ("rad", True, "OLYMPUS"),
        ("dB", True, "OLYMPUS"),
    ]
    assert found[4][2].endswith(": " + cause)
    words = ("beacon cone", "beacon", "answer", "residual pointing error", "communication", "stroke", "fine pointing")
    words += ("link margin for 99.7 % of the time",)
    assert all(r.name.lower().startswith(word) for r, word in zip(rows, words, strict=True))
    assert [r.mark for r in rows] == ["derived", "PASS", "PASS", "FAIL", "FAIL", "FAIL", "PASS", "derived"]
    assert result.closes and not result.met and result.margin_db == rows[-1].actual > rows[4].actual
    for line in rows:
        sign = -1 if line.name.startswith(("residual pointing error", "fine pointing")) else 1
        assert_allclose(line.margin, sign * (line.actual - line.required), rtol=1e-9)
        assert line.met == (line.margin >= 0)
    cone = requirement(result, "beacon cone over the root sum square")
    assert_allclose([cone.required, cone.actual], [np.sqrt(300**2 + 24**2 + 248**2 + 1**2) * 1e-6, 390e-6], rtol=1e-9)
    assert_allclose(requirement(result, "communication").required, 3.0)


@pytest.mark.promise("readme-1", "report-6")
@pytest.mark.promise("day-2", "index-1")
def test_the_day_is_that_of_the_simulated_loop(shipped):
    result = shipped[0]
    best = next(c for c in result.performance.cases if f"{c.controller}, {c.source}" == result.day.loss.source)
    assert (result.day.loss.loss_db, result.day.loss.outage) == (best.outage_loss_db, best.outage)
    assert best.controller == "LQG"
    assert result.day.loss.loss_db < day_study.given_loss(result.links).loss_db - 1.0
    assert result.contact is not None and result.contact.contact.start_s == result.day.encounters[0].contact.start_s


def test_the_claims_beside_our_values(shipped):
    result, _ = shipped
    assert [(c.where, c.agrees) for c in result.claims] == [
        ("section 2.1", "inferred"),
        ("Table 2", "inferred"),
        ("section 2.2, Fig. 2", "inferred"),
        ("section 3.2", "no"),
        ("Eq. 2", "partly"),
        ("Fig. 5", "yes"),
        ("Fig. 6", "yes"),
        ("Fig. 8", "yes"),
        ("Fig. 8", "yes"),
        ("section 3.1, Fig. 6 and 8", "no"),
        ("abstract", "yes"),
        ("section 2.2", "yes"),
        ("abstract", "partly"),
        ("abstract", "yes"),
    ]
    ours = [c.ours for c in result.claims]
    assert "inferred, hence circular: 3 dB at 300 Mbit/s and 10 µrad imply" in result.claims[2].why
    assert ours[3].startswith("1.07 mrad")
    assert ours[4].startswith("gain 0.1625 at DC")
    assert ours[5] == "2.43 % at 1 Hz, 6.92 % at 60 Hz, 9.86 % at 80 Hz, 14.05 % at 100 Hz"
    assert ours[6].startswith("1 Hz: peak 1.3 → 8.8 µrad")
    for claim, freq_hz in zip(ours[7:9], (15.0, 25.0), strict=True):
        before, after = (peaks(result)[c, freq_hz] for c in ("PID", "PID + inverse"))
        assert claim.startswith(f"{1e6 * (before - after):.1f} µrad: peak {1e6 * before:.1f} → {1e6 * after:.1f} µrad")
    assert ours[9].startswith("4 of 5 claims hold together at 17 of 60 scanned points")
    assert "cascade: Kp 0 to 4 V/mrad, Ki 14000 to 16000 V/(mrad s)" in result.claims[9].why
    assert "Nowhere together with these: PID + inverse stays within 10 µrad" in result.claims[9].why


@pytest.mark.promise("report-8")
@pytest.mark.promise("link-1", "link-42")
@pytest.mark.parametrize(
    ("source", "controller", "margin_db", "cost_db", "cost_mbit_s"),
    [
        ("sine of 15 Hz", "PID", -3.63, 0.02, 0.3),
        ("sine of 15 Hz", "PID + inverse", 2.90, 2.32, 206.8),
        ("sine of 25 Hz", "PID + inverse", 2.06, 3.10, 252.2),
        ("vibration and noise", "PI", 4.72, 0.20, 20.9),
        ("vibration and noise", "PI + inverse", 4.72, 0.20, 20.9),
        ("vibration and noise", "LQG", 4.79, 0.1452, 15.39),
    ],
)
def test_what_hysteresis_costs_the_link(shipped, source, controller, margin_db, cost_db, cost_mbit_s):
    """Margin for 99.7 % of the time, the rate with 3 dB there, what hysteresis takes; two are in docs/link.md."""
    found = shipped[0].performance
    case = found.case(source, controller, "given")
    (cost,) = [c for c in found.costs if (c.source, c.controller, c.mirror) == (source, controller, "given")]
    assert_allclose(case.margin_db, margin_db, atol=0.005)
    assert_allclose(case.data_rate_bit_s, 300e6 * 10 ** ((case.margin_db - 3.0) / 10), rtol=1e-9)
    assert_allclose(-cost.margin_db, cost_db, atol=0.005)
    assert_allclose(-cost.data_rate_bit_s, cost_mbit_s * 1e6, atol=0.06e6)
    (row,) = [
        r
        for r in performance_table(found.cases, found.costs, found.outage).rows
        if r[:3] == [source, controller, "given"]
    ]
    assert row[7] == f"{margin_db:+.2f}".replace("-", "\u2212")
    assert row[-2:] == [f"{cost_db:.2f}", "0.28" if cost_mbit_s == 0.3 else f"{cost_mbit_s:.0f}"]


def test_the_beacon_brings_four_times_what_its_partners_sensor_needs(shipped):
    beacon = shipped[0].beacon
    assert_allclose(beacon.irradiance_w_m2, 2.42e-9, atol=0.005e-9)
    assert_allclose(beacon.required_irradiance_w_m2, 566e-12, atol=0.5e-12)
    assert_allclose(beacon.required_irradiance_w_m2, 10e-12 / (pi / 4 * 0.15**2), rtol=1e-9)
    said = consequences(shipped[0].links)
    (line,) = [each for each in said if each.startswith("Beacon at its partner")]
    assert "2.42 nW/m^2 at the pointing error" in line
    assert line.endswith("needs 566 pW/m^2.")


def test_acquisition_is_as_fast_as_the_reference_asks_for(shipped):
    """LLCD took about 100 s, and the standard of the SDA asks for 100 s at most; here the last attempt is within it."""
    for way in shipped[0].links.finding.ways:
        locked = way.outcome.locked
        assert max(locked.time_s) < 100.0
        assert locked.cumulative(100.0) > 0.998
        assert locked.cumulative(10.0) < 0.5  # the body's settling alone


def test_the_map_of_the_margin_meets_the_budget(shipped):
    fig2 = shipped[0].margin_map
    assert fig2.margin_db.shape == (len(fig2.data_rate_bit_s), len(fig2.pointing_error_rad))
    row = np.argmin(np.abs(fig2.pointing_error_rad - 10e-6))
    at_300 = np.interp(log10(300e6), np.log10(fig2.data_rate_bit_s), fig2.margin_db[:, row])
    assert_allclose(at_300, shipped[0].communication.margin_db, atol=1e-6)
    assert np.all(np.diff(fig2.margin_db, axis=0) < 0)
    assert np.all(np.diff(fig2.margin_db, axis=1) < 0)
    assert_allclose(fig2.largest_rate_bit_s, 300e6 * 10 ** ((shipped[0].communication.margin_db - 3) / 10), rtol=1e-9)
    assert_allclose(fig2.largest_error_rad, 10e-6, rtol=2e-3)


STEPS = (
    "budgets, acquisition, mirror and tracking",
    "claims of the paper",
    "the day",
    "verdict",
)


def test_progress_grows(shipped):
    _, said = shipped
    assert [message for message in said if message[2] in STEPS] == [(done, 3, what) for done, what in enumerate(STEPS)]
    scan = [(done, total) for done, total, what in said if what == "scan of gains and compositions"]
    assert scan == [(done, len(scan)) for done in range(1, len(scan) + 1)]
    assert len(scan) > 4
    assert said[-1][0] == said[-1][1]


# ------------------------------------------------------------------------------------------------ other missions


def test_a_larger_receiver_raises_the_margin_by_its_gain(shipped, variant):
    result = variant(('geo_aperture = "15 cm"', 'geo_aperture = "20 cm"'))
    gain = 20 * log10(20 / 15)
    for name in ("communication", "achieved", "beacon"):
        raised = getattr(result, name).margin_db - getattr(shipped[0], name).margin_db
        assert_allclose(raised, gain, atol=1e-9, err_msg=name)
    assert peaks(result) == peaks(shipped[0])
    assert result.scan is None
    assert "all closed-loop claims at once" not in [c.claim for c in result.claims]


def test_a_larger_transmitter_also_narrows_the_beam(shipped, variant):
    result = variant(('leo_aperture = "5 cm"', 'leo_aperture = "6 cm"'))
    loss = 20 * log10(np.e) * (10e-6 * pi * 0.025 / 1.55e-6) ** 2
    assert_allclose(loss, 2.23, atol=0.005)
    raised = result.communication.margin_db - shipped[0].communication.margin_db
    assert_allclose(raised, 20 * log10(6 / 5) - loss * ((6 / 5) ** 2 - 1), atol=1e-9)


@pytest.mark.promise("report-8")
def test_the_residual_passes_in_rms(shipped, variant):
    result = variant(('residual_statistic = "peak"', 'residual_statistic = "rms"'))
    before, after = (requirement(r, "residual pointing error") for r in (shipped[0], result))
    assert (before.met, after.met) == (False, True)
    assert after.actual == result.residual.trace.rms_rad == shipped[0].residual.trace.rms_rad
    assert after.actual < before.actual / 3
    assert requirement(result, "communication").met
    assert result.achieved.margin_db > 5.0


def test_an_unstable_loop_says_so(variant):
    message = r"the closed loop is unstable: a pole at \|z\| = 1\.\d+ .*lower the gains in \[control\]"
    with pytest.raises(ValueError, match=message):
        variant(('integral = "16000 V/(mrad s)"', 'integral = "800000 V/(mrad s)"'))


PLAYS = """[mirror.prandtl_ishlinskii]
thresholds = ["0 V", "0.5 V", "2 V"]   # assumption: test
weights = ["60 urad/V", "20 urad/V", "9 urad/V"]   # assumption: test

"""


def plays(weights='"60 urad/V", "20 urad/V", "9 urad/V"'):
    """Changes that put a static Prandtl-Ishlinskii mirror in place of the shipped one."""
    text = SHIPPED.read_text()
    tables = text[text.index("[mirror.linear]") : text.index("[amplifier]")]
    table = PLAYS.replace('"60 urad/V", "20 urad/V", "9 urad/V"', weights)
    return (tables, table), ('composition = "cascade"', 'composition = "static"')


@pytest.mark.promise("report-8")
def test_a_static_mirror_of_plays_runs_through(coarse, tmp_path):
    result = study.run_study(edited_file(tmp_path, *plays(), day=False))
    assert result.scan is None
    assert result.comparison is None
    claims = [(c.where, c.claim) for c in result.claims]
    assert "Eq. 2" not in [where for where, _ in claims]
    assert [where for where, _ in claims if "Fig" in where][-3:] == ["Fig. 6", "Fig. 8", "Fig. 8"]
    assert {r.mirror for r in result.runs} == {"given", "no hysteresis"}
    with_inverse, without = peaks(result)["PID + inverse", 25.0], peaks(result)["PID", 25.0]
    assert with_inverse < 0.15 * without
    straight = peaks(result, "no hysteresis")["PID + inverse", 25.0]
    assert_allclose(with_inverse, straight, rtol=0, atol=0.2e-6)
    assert requirement(result, "residual pointing error").limited_by == "lag of the loop at 25 Hz"
    widths = [loop.width for loop in result.loops]
    assert_allclose(widths, 2 * (20 * 0.5 + 9 * 2) / (2 * (89 * 6 - 20 * 0.5 - 9 * 2)), rtol=1e-3)


def test_a_mirror_without_inverse_is_refused(coarse, tmp_path):
    with pytest.raises(ValueError, match="no weight at threshold 0"):
        study.run_study(edited_file(tmp_path, *plays('"0 urad/V", "80 urad/V", "9 urad/V"'), day=False))


def test_a_mechanical_angle_is_doubled_and_the_loop_stays(shipped, variant):
    """The gain doubles, the gains of the controller are halved, and everything is said of the line of sight."""
    result, usual = variant(('mirror_angle = "line-of-sight"', 'mirror_angle = "mechanical"')), shipped[0]
    for name in ("gain_up", "phase_rad", "delay_s", "modulus", "disk", "crossover_hz"):
        assert_allclose(getattr(result.margins, name), getattr(usual.margins, name), rtol=1e-9)
    for case, peak in peaks(result, "no hysteresis").items():
        assert_allclose(peak, peaks(usual, "no hysteresis")[case], rtol=0.01, atol=0.02e-6)
    for one, other in zip(result.runs, usual.runs, strict=True):
        assert_array_equal(one.trace.reference_rad, other.trace.reference_rad)
        halved = np.ptp(one.trace.drive_v[one.trace.steady]) / np.ptp(other.trace.drive_v[other.trace.steady])
        assert_allclose(halved, 0.5, atol=0.04)  # twice the hysteresis takes a little more than half the drive
    assert [loop.width for loop in result.loops] == [loop.width for loop in usual.loops]
    assert 1.5 < result.residual.trace.peak_rad / usual.residual.trace.peak_rad < 2.1
    assert result.achieved.margin_db < usual.achieved.margin_db - 3.0


def test_without_comparison_there_is_none(variant):
    text = SHIPPED.read_text()
    table = re.search(r"\[mirror\.comparison\.bouc_wen\].*?(?=\[amplifier\])", text, re.DOTALL).group()
    result = variant((table, ""))
    assert result.comparison is None
    assert len(result.runs) == 10


@pytest.mark.endurance
def test_a_proportional_loop_is_stable(variant):
    result = variant(('integral = "16000 V/(mrad s)"', 'integral = "0 V/(mrad s)"'))
    assert isinstance(result.runs[0].trace, simulate.Trace)


def test_the_residual_in_the_budget_says_which_run_it_is_from(shipped):
    found, _ = shipped
    (line,) = [line for line in found.achieved.lines if line.name == "Pointing loss"]
    assert line.source == "simulated: given, PID + inverse, 25 Hz, peak (per-axis)"


def test_a_link_with_more_light_received_than_sent_does_not_close(tmp_path, dayless):
    """The paper's terminals at 1 m, without a fine-pointing loop and with one."""
    far = dayless
    near = study.run_study(edited_file(tmp_path, ('distance = "42000 km"', 'distance = "1 m"'), day=False))
    assert (far.achieved.possible, far.closes, far.requirements[-1].unknown) == (True, True, "")
    row = near.requirements[-1]
    assert near.margin_db > 100.0 and row.margin > 100.0
    assert (row.met, row.because) == (False, IMPOSSIBLE)
    assert not near.met and not near.closes
    assert headline(near).startswith("Whether the link closes at ") and headline(near).endswith(
        f" is not known: {IMPOSSIBLE}."
    )
    assert [case.possible for case in far.performance.cases] == [True] * len(far.performance.cases)
    assert not any(case.possible for case in near.performance.cases)


def test_a_jitter_is_not_summed_with_what_the_simulated_loop_leaves(tmp_path, dayless):
    """The paper's mission with [jitter]: one margin is judged, and each other one stands under its own name."""
    jitter = '[jitter]\nbias = ["0 urad", "0 urad"]\nrms = ["10 urad", "10 urad"]\nbandwidth = "50 Hz"\n\n'
    plain = dayless
    shaken = study.run_study(edited_file(tmp_path, ("[requirement]", jitter + "[requirement]"), day=False))
    assert shaken.requirements == plain.requirements and headline(shaken) == headline(plain)
    assert shaken.tornado == plain.tornado
    error_rad = 10e-6 * np.sqrt(-2.0 * np.log(0.003))
    half_rad = 1.55e-6 / (np.pi * 0.025)
    under_db = plain.static.margin_db - 20 / np.log(10) * (error_rad**2 - 1e-10) / half_rad**2
    assert shaken.communication.margin_db == pytest.approx(under_db, abs=1e-6)
    assert shaken.static.margin_db == plain.static.margin_db == plain.communication.margin_db
    first, *_ = words.warnings(shaken)
    assert first.startswith("[jitter] is not in this verdict, which judges the pointing error that the simulated loop")
    assert f"Under [jitter] alone the margin is \u2212{-under_db:.2f} dB for 99.7 % of the time" in first
    assert first in " ".join(words.verdict_text(shaken, 80).split())
    assert not any("[jitter]" in warning for warning in words.warnings(plain))
    said = "As budgeted, at 10 µrad, the {} is +3.00 dB; 3 dB is required."
    assert words.papers_loop(shaken)[0] == said.format("static margin")
    assert words.papers_loop(plain)[0] == said.format("margin")
    assert "static margin +3.00 dB as budgeted," in chain.stages(shaken)[1].lines
    texts = [row[5] for row in requirement_views.judged_table(shaken, shaken.requirements).rows]
    assert texts == [row[5] for row in requirement_views.judged_table(plain, plain.requirements).rows]
    assert "outage" not in texts[-1] and "moves most with terminals.geo_aperture: 1.74 dB" in texts[-1]
    margins = summary(shaken)["margin_db"]
    assert margins["communication_as_budgeted"] == shaken.communication.margin_db
    assert (margins["communication_static"], margins["judged"]) == (shaken.static.margin_db, plain.margin_db)
    drawn, other = figures.margin_map(shaken), figures.margin_map(plain)
    assert f"at {error_rad * 1e6:.4g} µrad (exceeded by the jitter for the outage), or at most 10.00" in drawn.caption
    assert "Mbit/s at 10 µrad, or at most 10.00" in other.caption
    assert "static error: 300 Mbit/s at 10" in drawn.plot and "budget: 300 Mbit/s at 10" in other.plot


@pytest.mark.promise("report-6")
@pytest.mark.parametrize("shipped", [DEFAULT, SHIPPED], ids=["met", "missed"])
def test_what_to_change_for_the_stroke_just_meets_it(tmp_path, shipped):
    text = shipped.read_text(encoding="utf-8")
    (tmp_path / "mission.toml").write_text(text, encoding="utf-8")

    def stroke():
        file = load_mission(tmp_path / "mission.toml")
        fine = SimpleNamespace(
            scene=scene_of(file),
            quantile=0.997,
            budget=SimpleNamespace(dominant=""),
            best=SimpleNamespace(
                design=SimpleNamespace(name=""), simulated={"given": SimpleNamespace(quantile_rad=1e-6)}
            ),
        )
        case = SimpleNamespace(margin_db=5.0, possible=True)
        row = verdict.of_fine_pointing(file.mission.requirement, {}, fine, case)[0]
        return row, requirement_views.advice(SimpleNamespace(file=file, fine_pointing=fine), row)

    row, said = stroke()
    form = {
        True: r"; to move it, change fine_pointing\.body\.error, which may be (\d+) µrad at most",
        False: r"; to meet it, take fine_pointing\.body\.error = (\d+) µrad or less",
    }
    value = re.fullmatch(form[row.met], said)[1]
    error = 'error = "300 urad"                    # paper: section 2.1, attitude control accuracy taken as reference'
    at = text.index(error, text.index("[fine_pointing.body]"))
    (tmp_path / "mission.toml").write_text(text[:at] + error.replace("300", value) + text[at + len(error) :], "utf-8")
    assert row.met is (shipped == DEFAULT)
    assert 0.0 <= stroke()[0].margin < 1.01e-6


@pytest.mark.parametrize("margin_db", [-1.0, -20.0, -4000.0])
def test_power_is_advised_up_to_ten_times_of_what_there_is_however_much_lacks(margin_db):
    r = SimpleNamespace(subject="communication", margin=margin_db, met=False)
    lost = SimpleNamespace(key="communication.distance", swing_db=3.0)
    said = requirement_views.advice_for_power(SimpleNamespace(transmit_power_w=5.0), r, SimpleNamespace(swings=[lost]))
    near = "; to meet it, take communication.transmit_power = 6.3 W or more"
    assert said == (near if margin_db == -1.0 else "; to meet it, change communication.distance")


def test_a_judged_pointing_loss_beyond_20_db_is_warned_of(tmp_path, dayless):
    """A beam of 15 cm that its loop leaves 12 µrad off: the budget at its static error of 1 µrad warns of nothing."""
    wide = ('leo_aperture = "5 cm"', 'leo_aperture = "15 cm"')
    error = 'pointing_error = "10 urad"            # paper: Table 2'
    found = study.run_study(edited_file(tmp_path, wide, (error, error.replace("10 urad", "1 urad")), day=False))
    assert found.achieved.loss_db("Pointing loss") > 20.0 > found.static.loss_db("Pointing loss")
    warning = words.warnings(found)[0]
    assert warning.startswith(f"the verdict's pointing loss of {found.achieved.loss_db('Pointing loss'):.2f} dB is bey")
    assert not any("Pointing loss" in each for each in found.links.communication.warnings)
    assert not any("20 dB" in each for each in words.warnings(dayless))


def test_claims_of_the_links_are_judged_on_the_papers_numbers_whatever_the_receiver(tmp_path):
    receiver = (
        '[communication.receiver]\nmodulation = "dpsk"\ndetector = "preamplified"\nbit_error_ratio = 1e-9\n'
        'code_gain = "0 dB"\ncode_rate = 1.0\nbandwidth = "100 MHz"\nnoise_figure = "4 dB"\n\n'
    )
    text = SHIPPED.read_text(encoding="utf-8")
    sensitivity = next(line for line in text.splitlines() if line.startswith("receiver_sensitivity"))
    head = f"# {'-' * 97} what is required"
    largest = ('data_rate = "300 Mbit/s"', 'data_rate = "largest"')
    file = edited_file(tmp_path, (sensitivity, ""), (head, receiver + head), largest, day=False)
    result = study.run_study(file)
    claim = next(c for c in result.claims if c.where == "section 2.2, Fig. 2")
    assert (claim.agrees, claim.ours) == ("inferred", "3.00 dB at 300 Mbit/s and 10 µrad")  # on the paper's receiver
    assert result.file.mission.communication.data_rate_bit_s == 100e6
    assert result.margin_map.data_rate_bit_s[-1] == pytest.approx(100e6, rel=1e-9)


def test_nothing_that_a_loop_must_do_is_met_by_a_mirror_without_dynamics():
    known = load_mission(SHIPPED).mission
    bare = known.model_copy(update={"mirror": known.mirror.model_copy(update={"linear": None})})
    scene = scene_of(load_mission(SHIPPED))

    def judged(m, left_rad, possible=True):
        best = SimpleNamespace(
            design=SimpleNamespace(name="PI"), simulated={"given": SimpleNamespace(quantile_rad=left_rad)}
        )
        of = replace(scene, mirrors=replace(scene.mirrors, table=m.mirror))
        fine = SimpleNamespace(best=best, quantile=0.997, budget=SimpleNamespace(dominant="Gauge"), scene=of)
        case = SimpleNamespace(margin_db=5.0, possible=possible)
        return verdict.of_fine_pointing(m.requirement, {}, fine, case)[1:]

    for m, met in ((known, True), (bare, False)):
        for each in judged(m, 5e-6):
            assert (each.margin > 0, each.met) == (True, met)
            assert each.because == ("Gauge" if met else "dynamics of the mirror, which its model does not have")
        assert not judged(m, 11e-6)[0].met
        of = SimpleNamespace(unknown_dynamics=unknown_dynamics(m.mirror))
        assert not_reliable(of) == ([] if met else [f"Not to be relied on: {unknown_dynamics(m.mirror)}."])
    assert [each.because for each in judged(known, 5e-6, possible=False)] == ["Gauge", IMPOSSIBLE]
    assert "resonances and its lag are not known" in unknown_dynamics(bare.mirror)
    assert unknown_dynamics(bare.mirror) in summarise(bare.mirror).warnings
    assert not any("linear part" in text for text in summarise(known.mirror).warnings)


# ---------------------------------------------------------------------------------------- whether a mission closes
@pytest.mark.parametrize(
    ("beacon", "answer", "possible", "margin_db", "closes"),
    [
        (True, True, True, 0.0, True),
        (True, True, True, -0.9e-9, True),
        (True, True, True, -1.1e-9, False),
        (False, True, True, 5.0, False),
        (True, False, True, 5.0, False),
        (True, True, False, 5.0, False),
    ],
)
@pytest.mark.parametrize("fine", [False, True])
def test_a_mission_closes_with_all_three_links_under_the_judged_loop(beacon, answer, possible, margin_db, closes, fine):
    judged, other = SimpleNamespace(possible=possible), SimpleNamespace(possible=not possible)
    whole = SimpleNamespace(
        beacon=SimpleNamespace(closes=beacon),
        answer=SimpleNamespace(closes=answer),
        achieved=other if fine else judged,
        fine_case=judged if fine else None,
        margin_db=margin_db,
    )
    assert study.Study.closes.fget(whole) is closes


@pytest.mark.parametrize(
    ("with_loop", "loop", "closed"), [(True, True, True), (True, False, False), (False, True, False)]
)
def test_a_budget_of_errors_has_the_loop_where_it_is_asked_for_and_there_is_one(monkeypatch, with_loop, loop, closed):
    fine = SimpleNamespace(
        scene=SimpleNamespace(theory="theory"), best=SimpleNamespace(design=SimpleNamespace(controller="best"))
    )
    judged = []
    monkeypatch.setattr(study, "close", lambda *of: of)
    monkeypatch.setattr(study.error_budget, "judge", lambda *of: judged.append(of) or "judged")
    asked = SimpleNamespace(with_loop=with_loop)
    assert study.pointing_errors(asked, fine if loop else None) == "judged"
    assert judged == [(asked, ("theory", "best") if closed else None)]


@pytest.mark.parametrize(
    ("orbit", "operations", "constellation", "repeats", "found"),
    [
        (True, True, True, True, ("day", "contact", "plan")),
        (True, True, True, False, ("day", "contact", None)),
        (True, True, False, True, ("day", "contact", None)),
        (False, True, True, True, (None, None, None)),
        (True, False, True, True, (None, None, None)),
    ],
)
def test_a_mission_delivers_what_its_orbit_operations_and_constellation_allow(
    monkeypatch, orbit, operations, constellation, repeats, found
):
    mission = SimpleNamespace(
        orbit="orbit" if orbit else None,
        operations="operations" if operations else None,
        constellation="relays" if constellation else None,
        acquisition="acquisition",
    )
    links = SimpleNamespace(file=SimpleNamespace(mission=mission), data="data", finding="finding")
    monkeypatch.setattr(study.orbit, "repeats", lambda *of: repeats)
    monkeypatch.setattr(study.day_study, "run_day_study", lambda of, loss: ("day", loss))
    monkeypatch.setattr(study.contact_run, "of_mission", lambda *of: ("contact", *of))
    monkeypatch.setattr(study.constellation, "run_constellation", lambda file, loss: ("plan", loss))
    day, contact, plan = study.delivered(links, "loss", "fine")
    assert tuple(each and each[0] for each in (day, contact, plan)) == found
    if day is not None:
        assert day[1] == "loss"
        assert contact[1:] == ("operations", "acquisition", "data", ("day", "loss"), "finding", "fine")
    assert plan in (None, ("plan", "loss"))


def test_the_margin_is_that_of_the_judged_loop_and_all_requirements_have_to_be_met():
    achieved, fine = SimpleNamespace(margin_db=1.0), SimpleNamespace(margin_db=2.0)
    assert study.Study.margin_db.fget(SimpleNamespace(achieved=achieved, fine_case=None)) == 1.0
    assert study.Study.margin_db.fget(SimpleNamespace(achieved=achieved, fine_case=fine)) == 2.0
    met, missed = SimpleNamespace(met=True), SimpleNamespace(met=False)
    for lines, all_met in (((), True), ((met, met), True), ((met, missed), False), ((missed, met), False)):
        assert study.Study.met.fget(SimpleNamespace(requirements=lines)) is all_met


@pytest.mark.parametrize(
    ("highest", "most"), [(math.inf, 30.0), (3e9, 10.0), (9e9, 30.0), (3e8, 1.0)], ids=["none", "slow", "fast", "at it"]
)
def test_a_map_of_the_margin_goes_as_far_as_the_receiver_does_and_to_three_times_the_larger_error(
    monkeypatch, highest, most
):
    for name in ("margin_map", "convention_maps", "implied_sensitivity", "ideal_receivers"):
        monkeypatch.setattr(study.link, name, lambda *given: None)
    monkeypatch.setattr(study.link_study, "largest_rate", lambda data: 7.0)
    monkeypatch.setattr(study.link, "largest_pointing_error", lambda data, margin, rate: (margin, rate))
    receiver = None if math.isinf(highest) else SimpleNamespace(highest_data_rate_bit_s=highest)
    for allowed, budgeted in ((2e-6, 5e-6), (5e-6, 2e-6)):
        data = SimpleNamespace(
            requirement=SimpleNamespace(pointing_error_rad=allowed, margin_db=3.0),
            table=SimpleNamespace(data_rate_bit_s=3e8, pointing_error_rad=budgeted),
            receiver=receiver,
        )
        found = study.margin_map(data, {})
        assert found.data_rate_bit_s[[0, -1]] == pytest.approx([1e7, most * 3e8], rel=1e-12)
        assert found.pointing_error_rad[[0, -1]].tolist() == pytest.approx([0.0, 15e-6], rel=1e-12)
        assert found.largest_error_rad == (3.0, 3e8) and found.largest_rate_bit_s == 7.0

    def none(*given):
        raise study.link.LinkError("not even on axis")

    monkeypatch.setattr(study.link, "largest_pointing_error", none)
    assert math.isnan(study.margin_map(data, {}).largest_error_rad)


def test_the_paper_loop_is_judged_where_there_is_no_other_and_stands_beside_it_else(monkeypatch):
    monkeypatch.setattr(study.requirement, "of_beams", lambda links: ("beam",))
    monkeypatch.setattr(study.requirement, "of_fading", lambda links: ("fading",))
    monkeypatch.setattr(study.verdict, "of_fine_pointing", lambda *given: ("fine",))
    links = SimpleNamespace(data=SimpleNamespace(requirement=None), file=SimpleNamespace(sources=None))
    paper = ("residual",)
    assert study.judged(links, paper, None, None) == (("beam", "fading", "residual"), ())
    assert study.judged(links, paper, object(), None) == (("beam", "fading", "residual"), ())
    assert study.judged(links, paper, object(), object()) == (("beam", "fading", "fine"), paper)


# --------------------------------------------------------------------------------- who is asked for what, one by one
def test_a_loop_is_judged_by_its_own_requirement_and_sources(monkeypatch):
    monkeypatch.setattr(study.requirement, "of_beams", lambda links: ("beam", links.data.requirement))
    monkeypatch.setattr(study.requirement, "of_fading", lambda links: ("fading", links.file.sources))
    monkeypatch.setattr(study.verdict, "of_fine_pointing", lambda *given: given)
    links = SimpleNamespace(data=SimpleNamespace(requirement="wanted"), file=SimpleNamespace(sources="sources"))
    judged = ("beam", "wanted", "fading", "sources", "wanted", "sources", "fine", "case")
    assert study.judged(links, ("paper",), "fine", "case") == (judged, ("paper",))


@pytest.mark.parametrize("coupled", [True, False])
def test_a_fine_pointing_loop_is_designed_by_its_kind_with_its_parts_and_progress(monkeypatch, coupled):
    monkeypatch.setattr(study.coupled_study, "CoupledScene", str if coupled else int)
    monkeypatch.setattr(study.coupled_study, "design_and_simulate", "of several")
    monkeypatch.setattr(study.controller_study, "design_and_simulate", "of each axis")
    parts = SimpleNamespace(part=lambda *given, **told: (given, told))
    found = study.fine_pointing_loop("scene", parts, "progress")
    assert found == (("of several" if coupled else "of each axis", "scene"), {"on_progress": "progress"})


def test_the_best_case_is_that_of_the_best_controller_on_the_missions_own_mirror():
    fine = SimpleNamespace(best=SimpleNamespace(design=SimpleNamespace(name="LQG")))
    rows = [(s, c, m) for s in ("sine of 25 Hz", "vibration and noise") for c in ("PI", "LQG") for m in study.Variant]
    cases = tuple(SimpleNamespace(source=s, controller=c, mirror=m) for s, c, m in rows)
    held = study.pointing_penalty.LinkPerformance(0.01, 1e-6, cases, ())
    found = study.best_case(held, fine)
    assert (found.source, found.controller, found.mirror) == ("vibration and noise", "LQG", study.Variant.GIVEN)
    assert study.best_case(held, None) is None


def test_a_tornado_moves_the_margin_at_its_error_for_each_mission_that_is_moved(monkeypatch):
    asked = []
    monkeypatch.setattr(study.link, "margin_of_error", lambda data, error: np.float64(data + 1e6 * error))
    monkeypatch.setattr(study.link, "of", lambda mission: 100.0 * mission)

    def swings(m, sources, tables, strehl, margin, passes):
        asked.append((m, sources, tables, strehl, passes))
        return margin(3), margin(5)

    monkeypatch.setattr(study.link, "swings", swings)
    m = SimpleNamespace(conventions=SimpleNamespace(strehl="marechal"))
    links = SimpleNamespace(data=7.0, file=SimpleNamespace(mission=m, sources="sources"))
    found = study.tornado(links, 2e-6)
    assert (found.of, found.margin_db, found.swings) == ("Communication", 9.0, (302.0, 502.0))
    assert asked == [(m, "sources", study.link.LINK_TABLES, "marechal", study.link.beam_passes)]


def test_parts_that_are_kept_are_those_of_the_day_its_contact_and_its_constellation(monkeypatch):
    mission = SimpleNamespace(orbit="orbit", operations="ops", constellation="relays", acquisition="acquisition")
    file = SimpleNamespace(mission=mission)
    links = SimpleNamespace(file=file, data="data", finding="finding")
    monkeypatch.setattr(study.orbit, "repeats", lambda *of: of == ("relays", "orbit"))
    parts = SimpleNamespace(part=lambda *given: given)
    day, contact, plan = study.delivered(links, "loss", "fine", parts)
    assert day == (study.day_study.run_day_study, links, "loss")
    assert contact == (study.contact_run.of_mission, "ops", "acquisition", "data", day, "finding", "fine")
    assert plan == (study.constellation.run_constellation, file, "loss")
    asked = SimpleNamespace(with_loop=False)
    assert study.pointing_errors(asked, None, parts) == (study.error_budget.judge, asked, None)


class Given(str):
    """Something that tells by whom it was made of what, with a few attributes."""

    def __new__(cls, text, **attributes):
        found = super().__new__(cls, text)
        found.__dict__.update(attributes)
        return found


def told(name):
    """A function that gives its name and what it is given."""
    return lambda *given, **named: Given(f"{name}({', '.join(map(str, (*given, *named.values())))})")


def a_study_of_names(monkeypatch, *, fine, comparison, errors=None, content="whole", broken=()):
    """`run_study` of a mission with each function that it asks in name alone; what it gave, and its progress."""
    conventions = Given("conventions", residual="radial")
    m = SimpleNamespace(
        requirement=Given("q", residual_statistic="rms"),
        error_budget=None if errors is None else "table",
        fine_pointing="loop" if fine else None,
        conventions=conventions,
        mirror=Given("m.mirror", comparison="model" if comparison else None),
        amplifier="amplifier",
    )
    file = Given("file", mission=m, sources="sources", contents=(Given("a", content="x"), Given("b", content=content)))
    run, other = (Given(name, trace=Given(f"{name}.trace", name=f"{name} of 15 Hz")) for name in ("worst", "compared"))
    case = Given("case", error_rad="error", outage_loss_db=2.0, outage=0.25, controller="LQG", source="noise")
    links = Given("links", data="data")

    def raising(name):
        def fails(*given, **named):
            raise ValueError(name)

        return fails

    given = {
        study: ("margin_map", "fine_pointing_loop", "pointing_errors", "tornado"),
        study.link: ("tracking_light_w", "arrival_of", "communication_budget"),
        study.mirror: ("of",),
        study.paper_cases: ("of", "residual_rad"),
        study.alternatives: ("other_readings",),
        study.coupled_study: ("of_mission",),
        study.mirror_summary: ("summarise",),
        study.pointing_penalty: ("performance_of_loops",),
        study.verdict: ("residual_cause", "of_residual", "Evidence", "against_paper"),
        study.day_study: ("PointingLoss", "loss_at"),
        study.paper: ("scan",),
    }
    for module, names in given.items():
        for name in names:
            monkeypatch.setattr(module, name, told(name))
    budget = told("budget")
    for module, name, fake in (
        (study.link_study, "solve_rate", lambda of: of),
        (study, "with_contents", lambda of: of),
        (study.error_budget, "of_mission", lambda table, sources: Given(f"asked({table})", with_loop=errors)),
        (study.link_study, "run_link_study", lambda of, parts: links),
        (study.ensemble, "compile_in_background", lambda loop: lambda: None),
        (study.paper_cases, "simulate", lambda cases: ("loops", "margins", "runs")),
        (study.paper_cases, "worst", lambda runs, statistic, of=None: run if of is None else other),
        (study.paper, "applies", lambda of: comparison),
        (
            study.link,
            "margin_of_error",
            lambda data, error: {"residual_rad(q, conventions, compared.trace)": 5.5}[error],
        ),
        (study, "best_case", lambda found, of: None if of is None else case),
        (study, "judged", lambda *of: ((told("judged")(*of),), ("papers",))),
        (study.verdict, "of_error_budget", lambda *of: (told("of_error_budget")(*of),)),
        (
            study,
            "delivered",
            lambda *of: tuple(f"{name}: {told('delivered')(*of)}" for name in ("day", "contact", "plan")),
        ),
        (study.link, "communication_budget", lambda *of, **how: Given(budget(*of, **how), margin_db="m")),
    ):
        monkeypatch.setattr(module, name, fake)
    for module, name in broken:
        monkeypatch.setattr(module, name, raising(name))
    steps = []
    parts = Given("kept", part=lambda of, *args, **named: of(*args, **named))
    nothing = Given("nothing", part=lambda of, *args, **named: of(*args, **named))
    monkeypatch.setattr(study.kept, "NOTHING", nothing)
    progress = Given("progress")
    told_of = type("Told", (), {"__call__": lambda self, *step: steps.append(step), "__str__": lambda self: progress})()
    return study.run_study(file, told_of, parts), steps


LEFT = "residual_rad(q, conventions, worst.trace)"
READ = f"budget(data, sources, {LEFT}, simulated: worst of 15 Hz, rms (radial))"
FLOWN = "fine_pointing_loop(of_mission(file, of({m}), tracking_light_w(file), arrival_of(file)), {parts}, progress)"


def test_a_study_without_a_loop_of_its_own_rests_on_the_residual_of_the_papers_loop(monkeypatch):
    found, steps = a_study_of_names(monkeypatch, fine=False, comparison=False)
    m = found.file.mission
    mirrors, cases = f"of({m})", f"of({m}, of({m}))"
    cause = f"residual_cause({mirrors}, rms, worst, runs)"
    assert (found.links, found.loops, found.margins, found.runs) == ("links", "loops", "margins", "runs")
    assert (found.residual, found.achieved, found.margin_map) == ("worst", READ, "margin_map(data, sources)")
    assert found.other_readings == f"other_readings({m}, worst, kept)"
    assert (found.comparison, found.scan, found.fine_pointing, found.error_budget) == (None,) * 4
    assert found.performance == "performance_of_loops(data, radial, runs, None)"
    by_paper = f"of_residual(q, {mirrors}, sources, {READ}, {LEFT}, {cause})"
    assert (found.requirements, found.papers_loop) == ((f"judged(links, {by_paper}, None, None)",), ("papers",))
    loss = "loss_at(data, m, simulated: worst of 15 Hz)"
    assert (found.day, found.contact, found.plan) == tuple(
        f"{name}: delivered(links, {loss}, None, kept)" for name in ("day", "contact", "plan")
    )
    assert found.tornado == f"tornado(links, {LEFT})"
    summary = "summarise(m.mirror)"
    assert found.summary == summary
    evidence = f"Evidence(amplifier, {cases}, loops, {summary}, runs, None, {found.day})"
    assert found.claims == f"against_paper({evidence})"
    assert steps == [
        (0, 3, "budgets, acquisition, mirror and tracking"),
        (1, 3, "claims of the paper"),
        (2, 3, "the day"),
        (3, 3, "verdict"),
    ]


@pytest.mark.parametrize(("with_loop", "content"), [(True, "whole"), (False, None)])
def test_a_study_with_a_loop_of_its_own_is_judged_by_its_best_controller(monkeypatch, with_loop, content):
    """What is kept of earlier studies is left alone where one of the files could not be read."""
    found, _ = a_study_of_names(monkeypatch, fine=True, comparison=True, errors=with_loop, content=content)
    m, parts = found.file.mission, "kept" if content else "nothing"
    flown = FLOWN.format(m=m, parts=parts)
    assert found.fine_pointing == flown
    assert found.comparison == study.Comparison("compared", 5.5)
    assert found.scan == f"scan(of({m}, of({m})), progress)"
    assert found.performance == f"performance_of_loops(data, radial, runs, {flown})"
    assert found.error_budget == f"pointing_errors(asked(table), {flown}, {parts})"
    judged, errors = found.requirements
    assert judged.endswith(f", {flown}, case)") and found.papers_loop == ("papers",)
    assert errors == f"of_error_budget({found.error_budget}, sources, {flown if with_loop else None})"
    assert found.day == f"day: delivered(links, PointingLoss(2.0, 0.25, LQG, noise), {flown}, {parts})"
    assert found.tornado == "tornado(links, error)"
    assert found.other_readings == f"other_readings({m}, worst, {parts})"


def test_what_is_wrong_with_the_links_is_said_before_what_is_wrong_with_the_loop(monkeypatch):
    links, loop = (study.link_study, "run_link_study"), (study, "fine_pointing_loop")
    for broken, said in (((links, loop), "run_link_study"), ((loop,), "fine_pointing_loop"), ((links,), links[1])):
        with monkeypatch.context() as patch, pytest.raises(ValueError, match=f"^{said}$"):
            a_study_of_names(patch, fine=True, comparison=True, broken=broken)
