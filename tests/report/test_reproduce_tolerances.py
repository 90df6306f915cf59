"""How far each quantity of a study may lie from that of another machine: every one has a tolerance, and it bites."""

import copy
import math
import re

import numpy as np
import pytest

from microrad import report
from microrad.loop.pointing_loop.ensemble import COUNTERS
from microrad.report.data import finite
from microrad.report.links.data import performance_data
from microrad.report.results import comparison as compared
from microrad.report.results import reproduce, tolerances
from places import ROOT
from shipped import whole_drawn, whole_study

STEP_RAD = 0.305e-3 * 0.089e-3  # of the drive, through the mirror: 0.0271 µrad

TEXT = (ROOT / "docs" / "report.md").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def ran():
    return whole_study()[0]


@pytest.fixture(scope="module")
def summary(ran):
    return finite(report.summary(ran))


@pytest.fixture(scope="module")
def of_ran(ran):
    return tolerances.converter_steps(ran)


def numbers(summary):
    return [place for place, _, value, _ in compared.leaves(summary, summary, "") if compared.is_number(value)]


def moved(summary, place, by):
    """The summary with one number changed."""
    changed = copy.deepcopy(summary)
    *path, last = (int(key) if key.isdigit() else key for key in re.findall(r"[^.\[\]]+", place))
    at = changed
    for key in path:
        at = at[key]
    at[last] += by
    return changed


# -------------------------------------------------------------------------------------------------------------- stated
@pytest.mark.promise("report-17")
def test_every_number_of_a_summary_has_a_stated_tolerance(summary, of_ran):
    known, found = tolerances.tolerances(of_ran), numbers(summary)
    assert len(found) > 2000
    assert [place for place in found if tolerances.stated(place) not in known] == []
    assert tolerances.stated("margin_db.of_tomorrow") is None


def test_every_figure_has_a_stated_tolerance(of_ran):
    names = [figure.name for figure in whole_drawn().every]
    assert len(names) > 15
    known = {*tolerances.tolerances(of_ran), "curve"}
    assert [name for name in names if tolerances.stated_for_figure(name) not in known] == []
    assert tolerances.stated_for_figure("of-tomorrow") is None


def test_every_number_that_only_some_missions_have_has_a_stated_tolerance(ran):
    one = performance_data(ran.performance.cases[0])
    keys = [f"{key}[0]" if key in ("bias_rad", "rms_rad") else key for key in one]
    keys = [key for key in keys if key not in ("source", "controller", "mirror")]
    assert len(keys) > 15
    places = [f"{of}.{key}" for of in ("links.under_jitter", "performance[3]") for key in keys]
    places += [f"fine_pointing.controllers[0].simulated.given.shares.{name}" for name in COUNTERS]
    places += ["links.receiver_noise[0].value"]
    assert [place for place in places if tolerances.stated(place) is None] == []


def test_each_kind_is_one_that_is_used(of_ran):
    assert set(tolerances.tolerances(of_ran)) == {*tolerances.SUMMARY, *tolerances.FIGURES} - {"curve"}


# --------------------------------------------------------------------------------------------------------------- bites
@pytest.mark.promise("report-17")
def test_the_scale_is_made_of_the_largest_step_and_the_number_of_runs(ran, of_ran):
    assert of_ran.step_rad == pytest.approx(STEP_RAD, rel=1e-3)
    assert of_ran.run_rad == 2.0 * of_ran.step_rad
    assert of_ran.runs_rad == of_ran.run_rad / math.sqrt(ran.file.mission.fine_pointing.runs)
    half_angle, at = 20e-6, ran.file.mission.requirement.pointing_error_rad
    slope_db_rad = 20.0 / math.log(10.0) * 2.0 * at / half_angle**2  # of a Gaussian beam's loss, 10 lg exp(2 (e/w)^2)
    assert of_ran.run_db == pytest.approx(slope_db_rad * of_ran.run_rad, rel=0.5)


@pytest.mark.promise("report-18")
def test_two_roundings_differ_by_a_quarter_of_the_distance_that_a_statistic_may_move():
    rng = np.random.default_rng(1)
    first, second = (each - np.round(each) for each in rng.uniform(0.0, 100.0, (2, 100_000, 2)))
    apart = math.sqrt(np.mean(np.sum((first - second) ** 2, axis=1)))
    assert apart == pytest.approx(1.0 / math.sqrt(3.0), rel=0.01)
    assert f"{apart:.2f}" == "0.58"
    assert tolerances.APART / apart == pytest.approx(3.5, abs=0.1)


@pytest.mark.promise("report-17")
def test_the_table_of_kinds_has_the_distances_of_the_shipped_mission(ran, of_ran):
    found, m = tolerances.tolerances(of_ran), ran.file.mission
    rows = dict(re.findall(r"(?m)^\| (\w[\w ]*) \| [^|]* \| ([^|]*) \| [^|]* \|$", TEXT))
    runs = m.fine_pointing.runs
    assert runs == 64
    said = {
        "exact": "none" if found["exact"] == tolerances.Tolerance() else "",
        "formula": f"{found['formula'].relative:.0e}; {found['formula'].distance['dB']:.0e} dB".replace("e-0", "e-"),
        "linear theory": f"{found['linear theory'].relative:.0e}".replace("e-0", "e-"),
        "searched": f"{found['searched'].relative:.0e}".replace("e-0", "e-"),
        "orbit": f"{1e6 * found['orbit'].distance['s']:.0f} µs, and what a satellite does in them; "
        f"{found['orbit'].relative:.0e}".replace("e-0", "e-"),
        "run": f"two steps of the converters ({1e6 * found['run'].distance['rad']:.3f} µrad)",
        "runs": f"two steps over the root of the runs ({1e9 * found['runs'].distance['rad']:.1f} nrad for {runs})",
        "largest": "four steps",
        "interval": f"a tenth of what it is known to itself, {100 * found['interval'].relative:.1f} % for {runs} runs",
        "gain": "two tolerances of an rms, over it",
        "added": "√(2 rms · 2 tolerances of an rms)",
        "link": f"what four steps cost at the error that is allowed ({found['link'].distance['dB']:.2f} dB); "
        f"{100 * found['link'].relative:.0f} %",
        "fades": f"{100 * found['fades'].relative:.0f} %",
        "drawn": "four of the draws",
        "failed": "one in one of the days drawn",
        "volume": f"5 times the loss's tolerance in dB over all runs, {100 * found['volume'].relative:.1f} %",
        "spectrum": "4/√runs",
    }
    assert {kind: rows[kind] for kind in said} == said
    step, runs_rad = of_ran.step_rad, of_ran.runs_rad
    assert found["largest"].distance["rad"] == pytest.approx(4.0 * step)
    assert found["gain"].distance[""] == pytest.approx(2.0 * runs_rad / ran.fine_pointing.optimum_rad)
    assert found["added"].distance["rad"] == pytest.approx(
        math.sqrt(2.0 * ran.fine_pointing.budget.full_rad * 2.0 * runs_rad)
    )
    assert found["drawn"].distance[""] == 4.0 / m.acquisition.runs
    assert found["failed"].distance[""] == 1.0 / m.operations.runs
    assert found["spectrum"].relative == 4.0 / math.sqrt(runs)


@pytest.mark.promise("report-17")
@pytest.mark.parametrize(
    ("place", "inside", "outside"),
    [
        ("margin_db.beacon", 5e-8, 1e-6),
        ("links.budgets[0].lines[0].value", 1e-7, 1e-6),
        ("day.contacts[0].start_s", 1e-5, 1e-4),
        ("fine_pointing.controllers[0].parameters[0].value", 0.0, 1e-9),
        ("fine_pointing.controllers[0].theory_rms_rad", 1e-12, 1e-10),
        ("fine_pointing.controllers[0].simulated.given.rms_rad", 0.2475 * STEP_RAD, 0.2525 * STEP_RAD),  # 2 / sqrt(64)
        ("fine_pointing.controllers[0].simulated.given.largest_rad", 3.9 * STEP_RAD, 4.1 * STEP_RAD),
        ("residual.peak_rad", 1.9 * STEP_RAD, 2.1 * STEP_RAD),
        ("margin_db.communication_at_residual", 0.04, 0.1),
        ("runs[0].saturated", 0, 1),
        ("day.relay.contacts", 0, 1),
    ],
)
def test_each_kind_of_number_has_its_own_tolerance(summary, of_ran, place, inside, outside):
    allowed = reproduce.of_summary(of_ran)
    assert compared.compare(summary, moved(summary, place, inside), allowed).differences == ()
    found = compared.compare(summary, moved(summary, place, outside), allowed).differences
    assert [difference.place for difference in found] == [place]


def test_a_number_that_was_finite_and_is_not_any_more_is_another_one():
    for was, now in ((1.0, math.inf), (-math.inf, 1.0), (1.0, math.nan), (math.inf, -math.inf)):
        assert compared.compare({"a_db": was}, {"a_db": now}, lambda *_: math.inf).differences
    assert compared.compare({"a_db": math.inf}, {"a_db": math.inf}, lambda *_: math.inf).differences == ()


@pytest.mark.promise("report-18")
def test_a_number_without_a_stated_tolerance_has_to_be_the_same(of_ran):
    allowed = reproduce.of_summary(of_ran)
    assert compared.compare({"new_db": 1.0}, {"new_db": 1.0}, allowed).differences == ()
    assert compared.compare({"new_db": 1.0}, {"new_db": 1.0 + 1e-12}, allowed).differences


def test_another_order_of_sums_stays_inside_and_a_per_mille_does_not(summary, of_ran):
    """All numbers but those that have to be the same: in the twelfth digit, then in the fourth."""
    allowed = reproduce.of_summary(of_ran)

    def by(share):
        return {
            place
            for place, unit, value, _ in compared.leaves(summary, summary, "")
            if compared.is_number(value)
            and value
            and tolerances.stated(place) != "exact"
            and allowed(place, unit, value, value) < share * abs(value)
        }

    assert by(1e-12) == set()
    assert {tolerances.stated(place) for place in by(1e-3)} >= {"formula", "linear theory", "orbit"}


# ---------------------------------------------------------------------------------------- steps unlike each other
STEPS = tolerances.ConverterSteps(
    step_rad=3e-8, runs=25, allowed_rad=8e-6, rms_rad=1.5e-6, full_rad=2.5e-6, run_db=0.02, runs_db=0.005,
    rate_bit_s=622.08e6, acquisitions=800, days=16,
)  # fmt: skip


@pytest.mark.parametrize(
    ("kind", "relative", "distance"),
    [
        ("exact", 0.0, {}),
        ("formula", 1e-8, {"dB": 1e-8, "dBm": 1e-8, "rad": 1e-12, "": 1e-12}),
        ("linear theory", 1e-5, {"rad": 1e-12, "": 1e-5}),
        ("searched", 1e-4, {"rad": 1e-12, "": 1e-5}),
        ("run", 1e-6, {"rad": 6e-8}),
        ("runs", 1e-6, {"rad": 1.2e-8}),
        ("largest", 1e-6, {"rad": 1.2e-7}),
        ("interval", 1e-6 + 0.1 / math.sqrt(50.0), {}),
        ("gain", 1e-6, {"": 0.016}),
        ("added", 1e-6, {"rad": 2.0 * math.sqrt(2.5e-6 * 1.2e-8)}),
        ("fades", 0.25, {}),
        ("drawn", 0.005, {"": 0.005}),
        ("failed", 0.0, {"": 0.0625}),
        ("volume", 1e-6 + 0.025, {"s": 10.0 * tolerances.TOLERANCE_S, "bit": 1e10 * tolerances.TOLERANCE_S}),
        ("spectrum", 0.8, {}),
        (
            "link",
            0.01,
            {
                **{"rad": 6e-8, "dB": 0.04, "bit/s": 622.08e6 * (10.0**0.004 - 1.0)},
                "": math.sqrt(2.0 * 6e-8 / 8e-6) / math.pi,
            },
        ),
        (
            "orbit",
            1e-8,
            {
                unit: 10.0 * tolerances.TOLERANCE_S * rate
                for unit, rate in {"m": 8e3, "rad": 1e-3, "deg": 0.1, "Hz": 1e7, "bit": 1e9, "s": 1.0}.items()
            },
        ),
    ],
)
def test_the_distances_of_each_kind_follow_from_steps_runs_and_draws(kind, relative, distance):
    found = tolerances.tolerances(STEPS)[kind]
    assert found.relative == pytest.approx(relative, rel=1e-12)
    assert dict(found.distance) == pytest.approx(distance, rel=1e-12)
    unit = next(iter(distance), "")
    assert found.allowed(-4.0, 3.0, unit) == pytest.approx(4.0 * relative + distance.get(unit, 0.0))
    assert found.allowed(3.0, -4.0, "no unit of it") == pytest.approx(4.0 * relative)


@pytest.mark.parametrize(
    ("place", "kind", "unit"),
    [
        ("links.acquisition.ways[1].simulated_mean_time_s", "drawn", "s"),
        ("links.acquisition.ways[12].runs", "exact", ""),
        ("links.acquisition.ways[0].mean_time_s", "formula", "s"),
        ("performance[3].mean_fade_s", "fades", "s"),
        ("performance[3].outage", "link", ""),
        ("performance[3].data_rate_bit_s", "link", "bit/s"),
        ("day.optical.contacts_without_acquisition", "failed", ""),
        ("day.relay.latency_99_percent_s", "volume", "s"),
        ("day.contacts[4].could_carry_bit", "volume", "bit"),
        ("day.contacts[4].line_of_sight_rate_most_rad_s", "orbit", "rad/s"),
        ("day.contacts[4].range_rate_most_m_s", "orbit", "m/s"),
        ("contact.windows[0].largest_rad", "largest", "rad"),
        ("contact.windows[0].lowest_margin_db", "link", "dB"),
        ("contact.windows[0].range_m", "orbit", "m"),
        ("constellation.stations[2].use", "volume", ""),
        ("error_budget[1].mean_rad[0]", "linear theory", "rad"),
        ("error_budget[1].limit_rad", "exact", "rad"),
        ("error_budget[1].sources[2].may_be_times", "searched", ""),
        ("fine_pointing.controllers[2].simulated.no hysteresis.axis_rms_rad[1]", "runs", "rad"),
        ("fine_pointing.controllers[2].simulated.given.rms_interval_rad", "interval", "rad"),
        ("fine_pointing.controllers[2].margins.crossover_hz", "linear theory", "Hz"),
        ("fine_pointing.error_budget.differences[0].added_rms_rad", "added", "rad"),
        ("fine_pointing.error_budget.together_without_hysteresis_rms_rad", "runs", "rad"),
        ("fine_pointing.rms_left_to_gain.baseline_with_hysteresis", "gain", ""),
        ("fine_pointing.stroke.x[0].margin_rad", "formula", "rad"),
        ("margin_db.communication_static", "formula", "dB"),
        ("margin_db.judged", "link", "dB"),
        ("residual.used_rad", "run", "rad"),
        ("runs[7].frequency_hz", "exact", "Hz"),
        ("day.sky.correlation[0][1]", "formula", ""),
        ("day.direct.contacts_s", None, "s"),
        ("xday.duration_s", None, "s"),
        ("implied_sensitivity_photon_bit[1]", "formula", "photon/bit"),
        ("x.acceleration_rad_s2", None, "rad/s^2"),
    ],
)
def test_a_number_has_the_kind_and_the_unit_of_its_place(place, kind, unit):
    assert (tolerances.stated(place), tolerances.unit_of(place)) == (kind, unit)


@pytest.mark.parametrize(
    ("name", "kind"),
    [
        ("tornado-beacon", "formula"),
        ("pointing-errors-spectrum", "linear theory"),
        ("latency", "curve"),
        ("tornado-", None),
    ],
)
def test_the_data_of_a_figure_have_their_kind_by_its_whole_name(name, kind):
    assert tolerances.stated_for_figure(name) == kind


@pytest.mark.parametrize(
    ("was", "now", "same"),
    [
        ("peak −3.14 dB of 2 runs", "peak −3.15 dB of 2 runs", True),
        ("peak 0.01 dB", "peak 0.02 dB", True),  # one in the last digit
        ("peak 0.01 dB", "peak 0.03 dB", False),
        ("100 contacts", "104 contacts", True),
        ("100 contacts", "106 contacts", False),
        ("2 runs", "3 runs", False),
        ("1e-9 of it", "1.04e-9 of it", True),
        ("1e-9 of it", "2e-9 of it", False),
        ("4 % of A", "4 % of B", False),
        ("a 1", "a 1 2", False),
        ("-1.5 dB", "+1.5 dB", False),
    ],
)
def test_a_sentence_is_the_same_up_to_roundings_of_its_numbers(was, now, same):
    assert (compared.compare({"a": was}, {"a": now}, lambda *_: 0.0).differences == ()) is same
    assert compared.compare({"a": was}, {"a": now}, None).differences != ()
