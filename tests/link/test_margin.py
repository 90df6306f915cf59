"""One margin of the communication link, wherever it is asked for: the one that is kept but for the outage."""

import json
import math
import tomllib
from functools import cache

import numpy as np
import pytest

import budgets
from link_files import PATTERN, data_with, link_file, written
from microrad import report
from microrad.link import study as link_study
from microrad.link.requirement import IMPOSSIBLE
from microrad.loop import paper_cases
from microrad.mission.file import load_link, load_mission
from microrad.report.quantities import quantity, signed
from microrad.study import study
from scenes import cases_of
from shipped import DEFAULT, without_day, without_fine_pointing

NO_BEAMS = dict.fromkeys(("beacon", "answer", "acquisition"))
SHAKEN = {
    **NO_BEAMS,
    "terminals.leo_aperture": "2 cm",
    "jitter": {"bias": ["0 urad", "0 urad"], "rms": ["60 urad", "60 urad"], "bandwidth": "50 Hz"},
}


@pytest.mark.promise("link-5")
def test_a_link_that_is_below_0_db_most_of_the_time_does_not_close(call, tmp_path):
    """2 cm under 60 µrad rms per axis: +3.79 dB at the static error, below 0 dB for 0.65 of the time."""
    path = written(tmp_path, data_with(SHAKEN | {"communication.transmit_power": "40 W"}))
    result = call("budget", path, "--json")
    data = json.loads(result.out)
    (budget,) = data["budgets"]
    totals = {line["name"]: line["value"] for line in budget["totals"]}
    assert result.code == 1 and data["closes"] is False
    assert totals["Static margin"] > 3.0
    assert totals["Margin"] == budget["margin_db"] < -20.0
    assert data["under_jitter"]["margin_db"] == pytest.approx(budget["margin_db"], abs=1e-9)
    assert 0.5 < data["under_jitter"]["outage"] < 0.8
    assert any("Pointing loss: beyond 20 dB" in warning for warning in data["warnings"])
    said = call("budget", path).out
    assert said.startswith(f"The links do not close: communication {signed(budget['margin_db'], 'dB')}.\n")


@pytest.mark.promise("link-5")
@pytest.mark.parametrize("changes", [[], [PATTERN]], ids=["gaussian", "pattern"])
def test_the_margin_of_the_budget_is_the_one_under_the_jitter(tmp_path, changes):
    jitter = {"jitter": {"bias": ["1 urad", "2 urad"], "rms": ["3 urad", "4 urad"], "bandwidth": "50 Hz"}}
    found = link_study.run_link_study(link_file(tmp_path, NO_BEAMS, jitter, *changes))
    assert found.communication.margin_db == pytest.approx(found.under_jitter.margin_db, abs=1e-9)
    static = budgets.communication(found.file.mission, {}).margin_db
    assert found.communication.totals[-1].name == "Static margin"
    assert found.communication.totals[-1].value == static
    assert "10 µrad" in found.communication.totals[-1].basis
    plain = link_study.run_link_study(link_file(tmp_path, NO_BEAMS, *changes))
    assert [line.name for line in plain.communication.totals] == ["Received power", "Required power", "Margin"]


@pytest.mark.promise("link-5", "link-8")
def test_a_rate_is_solved_for_at_the_error_of_the_outage(tmp_path):
    jitter = {"jitter": {"bias": ["0 urad", "0 urad"], "rms": ["5 urad", "5 urad"], "bandwidth": "50 Hz"}}
    found = link_study.run_link_study(link_file(tmp_path, NO_BEAMS, jitter, {"communication.data_rate": "largest"}))
    assert found.communication.margin_db == pytest.approx(3.0, abs=1e-9)
    assert found.largest_rate_bit_s == pytest.approx(found.file.mission.communication.data_rate_bit_s, rel=1e-12)
    assert found.under_jitter.data_rate_bit_s == pytest.approx(found.largest_rate_bit_s, rel=1e-9)


@pytest.mark.promise("link-5")
def test_a_static_error_in_place_of_a_jitter_is_refused(call, tmp_path):
    result = call("budget", written(tmp_path, data_with(SHAKEN)), "--pointing-error", "5 urad")
    assert result.code == 2
    assert "--pointing-error changes no margin: under the table [jitter]" in " ".join(result.err.split())


def test_the_mean_loss_is_that_of_the_closed_form(tmp_path):
    """10 µrad per axis on 5 cm at 1.55 µm without bias: 3.0686 dB."""
    jitter = {"jitter": {"bias": ["0 urad", "0 urad"], "rms": ["10 urad", "10 urad"], "bandwidth": "50 Hz"}}
    found = link_study.run_link_study(link_file(tmp_path, NO_BEAMS, jitter)).under_jitter
    half = 2 * 1.55e-6 / (math.pi * 0.05)
    assert found.mean_loss_db == pytest.approx(10 * math.log10(1 + 4 * (10e-6 / half) ** 2), rel=1e-6)
    assert f"{found.mean_loss_db:.4f}" == "3.0686"


@pytest.mark.parametrize(
    ("value", "unit", "text"),
    [
        (-1e-12, "dB", "0.00 dB"),
        (-0.001, "dB", "\u22120.001 dB"),
        (-2.0, "dB", "\u22122.00 dB"),
        (1e-40, "", "below 1e-20"),
        (1e-19, "", "1e-19"),
    ],
)
def test_what_rounding_leaves_has_no_sign_and_no_share_is_smaller_than_it_can_be(value, unit, text):
    assert quantity(value, unit).rstrip() == text


# ------------------------------------------------------------------------------------------------------- by simulation
def drawn(rng):
    """Changes to the links of the paper, at random, that leave a mission."""
    bias, rms = rng.uniform(0, 8, 2), rng.uniform(0, 8, 2)
    return {
        **NO_BEAMS,
        "terminals.leo_aperture": f"{rng.uniform(2, 8)} cm",
        "communication.transmit_power": f"{10 ** rng.uniform(-0.5, 1.5)} W",
        "communication.data_rate": f"{10 ** rng.uniform(1.5, 3)} Mbit/s",
        "requirement.outage": float(10 ** rng.uniform(-3, -1)),
        "jitter": {"bias": [f"{b} urad" for b in bias], "rms": [f"{r} urad" for r in rms], "bandwidth": "50 Hz"},
        "point_ahead.transverse_velocity": f"{rng.uniform(0, 1)} km/s",
        "point_ahead.corrected": bool(rng.integers(2)),
    }


@pytest.mark.promise("link-5")
@pytest.mark.parametrize("seed", range(20))
def test_a_link_that_closes_keeps_its_margin_by_simulation(tmp_path, seed):
    """1e5 errors are drawn; the share below 0 dB is at most the outage, but for five deviations of that share."""
    rng = np.random.default_rng(seed)
    changes = drawn(rng)
    found = link_study.run_link_study(link_file(tmp_path, changes))
    m, runs = found.file.mission, 100_000
    errors = rng.normal(m.jitter.bias_rad, m.jitter.rms_rad, (runs, 2))
    ahead = 0.0 if m.point_ahead.corrected else 2.0 * m.point_ahead.transverse_velocity_m_s / 299792458.0
    half = 2.0 * m.communication.wavelength_m / (math.pi * m.terminals.leo_aperture_m)
    loss_db = 20.0 * math.log10(math.e) * (np.hypot(*errors.T) + ahead) ** 2 / half**2
    on_axis_db = budgets.communication(m, {}, pointing_error_rad=0.0).margin_db
    if ahead:  # the budget counts it from the axis on
        on_axis_db += 20.0 * math.log10(math.e) * (ahead / half) ** 2
    q = m.requirement.outage
    short = float(np.mean(loss_db > on_axis_db))
    spread = 5.0 * math.sqrt(q * (1.0 - q) / runs)
    if found.closes:
        assert short <= q + spread
    else:
        assert short >= q - spread
    assert found.under_jitter.outage == pytest.approx(short, abs=5.0 * math.sqrt(max(short, 1e-4) / runs))


# ----------------------------------------------------------------------------------------------------------- exit codes
ONE_ROW = """
mission = "link.toml"
seed = 1
runs = 1
sampling = "random"
[inputs."communication.transmit_power"]
distribution = "uniform"
low = "{low!r} W"
high = "{high!r} W"
"""


@pytest.mark.promise("link-3", "link-5")
@pytest.mark.usefixtures("rows_here")
@pytest.mark.parametrize(
    ("seed", "code"),
    [(0, 1), (41, 0), *(pytest.param(seed, 1, marks=pytest.mark.endurance) for seed in range(1, 6))],
)
def test_budget_and_a_campaign_of_one_row_end_alike(call, tmp_path, monkeypatch, seed, code):
    monkeypatch.chdir(tmp_path)
    path = written(tmp_path, data_with(drawn(np.random.default_rng(100 + seed))))
    power_w = load_link(path).mission.communication.transmit_power_w
    (tmp_path / "one.toml").write_text(ONE_ROW.format(low=power_w * (1 - 1e-9), high=power_w * (1 + 1e-9)))
    budget = call("budget", path, "--json")
    met = all(r["met"] for r in json.loads(budget.out)["requirements"])
    assert budget.code == (0 if met else 1) == code
    assert call("campaign", "run", "one.toml", "--threads", "1").code == budget.code


@cache
def _left_rad():
    m = load_mission(DEFAULT).mission
    runs = paper_cases.sine_runs(cases_of(m))
    return paper_cases.residual_rad(
        m.requirement, m.conventions, paper_cases.worst(runs, m.requirement.residual_statistic).trace
    )


def shaken_by_its_own_loop(rng, **communication):
    """The shipped mission at random, at the error that its loop leaves; without a day and a fine-pointing loop."""
    data = tomllib.loads(without_fine_pointing(without_day(DEFAULT.read_text(encoding="utf-8"))))
    data["requirement"]["pointing_error"] = "20 urad"
    data["terminals"]["geo_aperture"] = f"{rng.uniform(15, 18)} cm"
    data["communication"] |= {
        "transmit_power": f"{10 ** rng.uniform(0.4, 1.0)} W",
        "data_rate": f"{rng.uniform(200, 500)} Mbit/s",
        "pointing_error": f"{_left_rad()!r} rad",
        **communication,
    }
    return data


@pytest.mark.usefixtures("rows_here")
def test_budget_run_and_a_campaign_of_one_row_end_alike(call, tmp_path, monkeypatch):
    """Random whole missions, and one at 1 m, whose budget has more light arrive than was sent."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(study.paper, "applies", lambda m: False)  # this and the page take longer than all the rest
    monkeypatch.setattr(report, "write", lambda *args, **more: None)
    codes = []
    for name, seed, changes in (("meets", 0, {}), ("closes", 4, {}), ("near", 2, {"distance": "1 m"})):
        path = written(tmp_path, shaken_by_its_own_loop(np.random.default_rng(seed), **changes))
        power_w = load_link(path).mission.communication.transmit_power_w
        (tmp_path / "one.toml").write_text(ONE_ROW.format(low=power_w * (1 - 1e-9), high=power_w * (1 + 1e-9)))
        budget, run = call("budget", path, "--json"), call("run", path, "--output", name, "--json")
        row = call("campaign", "run", "one.toml", "--threads", "1", "--ledger", f"{name}.ledger", "--json")
        found, judged = json.loads(budget.out), json.loads(run.out)
        margin_db = {r["name"]: r["margin"] for r in found["requirements"]}["communication margin"]
        assert judged["requirements"][-1]["margin"] == pytest.approx(margin_db, abs=1e-9)
        assert (run.code, row.code) == (budget.code, budget.code)
        assert (judged["met"], judged["closes"]) == (found["met"], found["closes"])
        assert budget.code == (0 if margin_db >= 0.0 and name != "near" else 1)
        codes.append(budget.code)
    assert margin_db > 100.0
    assert IMPOSSIBLE in judged["verdict"] and json.loads(row.out)["cells"][0]["failed"] == 1
    assert codes[-1] == 1 and {0, 1} == set(codes[:-1])
