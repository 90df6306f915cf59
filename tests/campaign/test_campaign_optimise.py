"""Optimisation under a probability constraint: against closed forms, known optima, and what it must not claim."""

import itertools
import math
import os
import re
from concurrent.futures import ThreadPoolExecutor
from types import SimpleNamespace

import numpy as np
import pytest
import scipy.optimize
from scipy.optimize import NonlinearConstraint, brentq, differential_evolution
from scipy.stats import beta, norm

import budgets
from campaign_files import HEAD, LOOP, POWER, loaded
from microrad import link
from microrad.campaign.optimisation import campaign as optimisation_campaign
from microrad.campaign.optimisation import search
from microrad.campaign.optimisation.campaign import _CandidateRows
from microrad.campaign.optimisation.candidates import Candidate, Kept, Problem, Variable, judged, percent
from microrad.campaign.optimisation.search import optimise
from microrad.campaign.records import CampaignError, Interval, Limit
from microrad.campaign.rows import loops
from microrad.campaign.rows.evaluator import Evaluator
from microrad.core import threads as in_threads
from microrad.mission.file import load_link
from microrad.mission.presets import preset_text
from microrad.report.campaign import optimum as words
from microrad.report.campaign.optimum import fresh_rows_sentence, optimum_data, optimum_text

MARGIN = Limit("margin", 3.0, None, "test")
ANSWER = Limit("answer_margin", 3.0, None, "test")
APERTURE, DIVERGENCE = "terminals.leo_aperture", "answer.divergence"


SLACK = "for slack draw more rows (optimise.rows) or ask for a larger share (optimise.confidence)"


def quiet(*_):
    pass


def never(_):
    raise AssertionError("not to be called")


def gaussian(rows, seed):
    return np.random.default_rng(seed).normal(size=rows)


def unit_cube(size):
    return tuple(Variable(f"x{i}", "", 0.0, 1.0) for i in range(size))


def problem(**changes):
    given = {
        "variables": unit_cube(1),
        "minimise": "x0",
        "limits": (MARGIN,),
        "confidence": 0.99,
        "evaluations": 50,
        "seed": 1,
    }
    return Problem(**given | changes)


def rising(rows=400, seed=0, slope=10.0, spread=1.0):
    """Margin slope * x0 + noise: kept by a share with a closed form."""
    noise = gaussian(rows, seed)
    return lambda x: {"margin": slope * x[0] + spread * noise}


# ---------------------------------------------------------------------------------------------------- closed forms
@pytest.fixture(scope="module")
def mission(tmp_path_factory):
    path = tmp_path_factory.mktemp("link") / "link.toml"
    path.write_text(preset_text("paper"), encoding="utf-8")
    return load_link(path)


def with_values(file, aperture, divergence=None, answer_error=None):
    m = file.mission
    answer = {"divergence_rad": divergence, "pointing_error_rad": answer_error}
    terminals = m.terminals.model_copy(update={"leo_aperture_m": aperture})
    answer = m.answer.model_copy(update={k: v for k, v in answer.items() if v is not None})
    return m.model_copy(update={"terminals": terminals, "answer": answer})


@pytest.mark.promise("campaigns-41")
def test_smallest_aperture_is_that_of_the_normal_quantile(mission):
    """P(margin(aperture) + Gaussian loss >= 3 dB) >= 0.99: the aperture follows from the normal quantile alone."""
    rows, spread = 4000, 0.7
    noise = spread * gaussian(rows, 3)

    def margin(aperture):
        return float(link.margin_of_error(link.of(with_values(mission, aperture)), 5e-6))

    def evaluate(x):
        return {"margin": margin(x[0]) + noise}

    def fresh(x):
        return {"margin": margin(x[0]) + spread * gaussian(rows, 4)}

    aperture = Variable(APERTURE, "m", 0.02, 0.08)
    wanted = margin(0.05) - 1.0
    limit = Limit("margin", wanted, None, "test")
    found = optimise(problem(variables=(aperture,), minimise=APERTURE, limits=(limit,)), evaluate, fresh, quiet)
    quantile = norm.ppf(0.99)
    exact = brentq(lambda d: margin(d) - wanted - spread * quantile, 0.02, 0.06)
    # standard error of a sample quantile, as an aperture by the slope of the margin
    error_db = spread * math.sqrt(0.01 * 0.99 / rows) / norm.pdf(quantile)
    slope = (margin(exact * 1.01) - margin(exact)) / (0.01 * exact)
    assert found.feasible and found.reason == ""
    assert abs(found.best.cost - exact) < 3.0 * error_db / slope
    # to the search's own precision it is the aperture at which the 41st worst row is on the limit
    own = brentq(lambda d: margin(d) + np.sort(noise)[40] - wanted, 0.02, 0.06)
    assert own <= found.best.cost < own + 2e-4 * 0.06
    assert found.best.kept[0].share.value == pytest.approx(0.99, abs=1e-12)
    assert found.bound_by == ("margin",)
    assert abs(found.fresh.kept[0].share.value - 0.99) < 4.0 * math.sqrt(2 * 0.01 * 0.99 / rows)
    assert found.fresh.kept[0].share.value != found.best.kept[0].share.value


def test_aperture_and_divergence_of_the_answer(mission):
    """The Gaussian beam that is widest in dB at error r has theta = sqrt(2) r; the aperture then follows."""
    rows, sigma = 400, 8e-6
    error = sigma * np.sqrt(-2.0 * np.log(np.random.default_rng(5).uniform(size=rows)))
    clear = with_values(mission, 0.05, 40e-6, 0.0)
    base_db = budgets.answer(clear, mission.sources).margin_db

    def margin_db(aperture, divergence, r):
        """Relative to the real budget at 5 cm, 40 urad and no error."""
        gain = link.gains.gaussian_beam_gain_db(divergence / 2) - link.gains.gaussian_beam_gain_db(20e-6)
        received = link.gains.aperture_gain_db(aperture, 1.55e-6) - link.gains.aperture_gain_db(0.05, 1.55e-6)
        return base_db + gain + received - link.gains.gaussian_pointing_loss_db(r, divergence / 2)

    for trial in ((0.05, 40e-6, 0.0), (0.03, 70e-6, 15e-6), (0.12, 25e-6, 30e-6)):
        budget = budgets.answer(with_values(mission, *trial), mission.sources)
        assert margin_db(*trial) == pytest.approx(budget.margin_db, abs=1e-9)
    wanted = base_db - 4.0
    variables = (Variable(APERTURE, "m", 0.01, 0.3), Variable(DIVERGENCE, "rad", 20e-6, 200e-6))
    asked = problem(
        variables=variables,
        minimise=APERTURE,
        limits=(Limit("answer_margin", wanted, None, "test"),),
        evaluations=200,
    )

    def evaluate(x):
        return {"answer_margin": margin_db(x[0], x[1], error)}

    found = optimise(asked, evaluate, evaluate, quiet)
    decides = np.sort(error)[-1 - 4]  # 4 of 400 rows may miss the limit
    best = 2.0 * math.sqrt(2.0) * decides
    aperture = brentq(lambda d: margin_db(d, best, decides) - wanted, 1e-3, 1.0)
    assert aperture <= found.best.values[APERTURE] < aperture * 1.001
    assert found.best.values[DIVERGENCE] == pytest.approx(best, rel=0.03)
    assert found.best.kept[0].share.value == 0.99
    # and the draws' quantile is Rayleigh's within its error
    assert decides == pytest.approx(sigma * math.sqrt(-2.0 * math.log(0.01)), rel=0.12)


# ---------------------------------------------------------------------------------------------------- known optima
def gomez_levy(x):
    """Disjoint feasible regions, optimum -1.031628453 at (0.0898, -0.7126)."""
    a, b = -1.0 + 1.75 * x[0], -1.0 + 2.0 * x[1]
    cost = 4 * a**2 - 2.1 * a**4 + a**6 / 3 + a * b - 4 * b**2 + 4 * b**4
    return cost, (1.5 + math.sin(4 * math.pi * a) - 2 * math.sin(2 * math.pi * b) ** 2,)


def rosen_suzuki(x):
    """Four variables, two active limits of three, optimum -44 at (0, 1, 2, -1)."""
    a, b, c, d = -3.0 + 6.0 * np.asarray(x)
    cost = a**2 + b**2 + 2 * c**2 + d**2 - 5 * a - 5 * b - 21 * c + 7 * d
    return cost, (
        8 - a**2 - b**2 - c**2 - d**2 - a + b - c + d,
        10 - a**2 - 2 * b**2 - c**2 - 2 * d**2 + a + d,
        5 - 2 * a**2 - b**2 - c**2 - 2 * a + b + d,
    )


def two_wells(x):
    """The deeper of two wells is narrower; the limit keeps off both by the same."""
    wide, narrow = 0.8 * math.exp(-(((x[0] - 0.25) / 0.15) ** 2)), math.exp(-(((x[0] - 0.8) / 0.06) ** 2))
    return -wide - narrow + (x[1] - 0.5) ** 2, (x[1] - 0.6,)


NAMES = ("margin", "answer_margin", "beacon_margin")


def as_rows(function, rows=128):
    """The function's cost as an output, and its constraints as outputs with a spread that is taken back exactly."""
    noise = norm.ppf((np.random.default_rng(2).permutation(rows) + 0.5) / rows)
    shift = -np.sort(noise)[1]  # 1 of 128 rows may miss a limit in 99 %

    def evaluate(x):
        cost, inside = function(x)
        outputs = {name: value + 0.05 * (noise + shift) for name, value in zip(NAMES, inside, strict=False)}
        return {"residual_rms": np.full(rows, cost)} | outputs

    return evaluate


@pytest.mark.parametrize(
    ("function", "size", "limits", "optimum", "scale", "known"),
    [
        (gomez_levy, 2, 1, (0.6227, 0.1437), 1.0, -1.031628453),
        (rosen_suzuki, 4, 3, (0.5, 4 / 6, 5 / 6, 2 / 6), 44.0, -44.0),
        (two_wells, 2, 1, (0.8, 0.6), 1.0, None),
    ],
)
@pytest.mark.parametrize("seed", [0, *(pytest.param(seed, marks=pytest.mark.endurance) for seed in (1, 2))])
def test_known_optima_are_found_in_200_evaluations(function, size, limits, optimum, scale, known, seed):
    known = function(optimum)[0] if known is None else known
    asked = problem(
        variables=unit_cube(size),
        minimise="residual_rms",
        limits=tuple(Limit(name, 0.0, None, "test") for name in NAMES[:limits]),
        evaluations=200,
        seed=seed,
    )
    found = optimise(asked, as_rows(function), as_rows(function), quiet)
    assert found.feasible
    assert -1e-6 * scale < found.best.cost - known < 1e-3 * scale
    assert np.array(list(found.best.values.values())) == pytest.approx(np.array(optimum), abs=0.02)
    assert found.evaluations <= 200


@pytest.mark.endurance
def test_a_global_peer_finds_no_better_with_ten_times_as_many_evaluations():
    evaluate = as_rows(two_wells)
    limit = Limit("margin", 0.0, None, "test")
    asked = problem(variables=unit_cube(2), minimise="residual_rms", limits=(limit,), evaluations=200)
    found = optimise(asked, evaluate, evaluate, quiet)
    peer = differential_evolution(
        lambda x: two_wells(x)[0],
        [(0.0, 1.0)] * 2,
        constraints=NonlinearConstraint(lambda x: np.sort(evaluate(x)["margin"])[1], 0.0, np.inf),
        popsize=40,
        tol=0.0,
        maxiter=60,
        polish=False,
        rng=np.random.default_rng(0),
    )
    assert peer.nfev > 1000
    assert abs(found.best.cost - peer.fun) < 2e-3
    assert found.best.cost < -0.9  # the wide well alone has -0.79


def test_a_rough_output_does_not_stop_the_search():
    """A controller tuned anew leaves a cost that is no smooth function of the variables."""

    def rough(x):
        cost, inside = rosen_suzuki(x)
        return cost + 0.02 * math.sin(1e5 * float(np.sum(x * np.arange(1, 5)))), inside

    limits = tuple(Limit(name, 0.0, None, "test") for name in NAMES)
    asked = problem(variables=unit_cube(4), minimise="residual_rms", limits=limits, evaluations=200)
    found = optimise(asked, as_rows(rough), as_rows(rough), quiet)
    assert -44.05 < found.best.cost < -43.6


@pytest.mark.promise("campaigns-40")
def test_maximising_an_output():
    """margin = 6 - (x - 0.3)^2 + noise * x: its mean is largest at 0.3."""
    noise = gaussian(1000, 8)
    noise -= noise.mean()

    def evaluate(x):
        return {"margin": 6.0 - 10.0 * (x[0] - 0.3) ** 2 + noise * x[0]}

    mean = optimise(problem(minimise="-margin"), evaluate, evaluate, quiet)
    assert mean.best.values["x0"] == pytest.approx(0.3, abs=2e-3)
    assert mean.best.cost == pytest.approx(6.0, abs=1e-4)
    assert mean.bound_by == ()


def test_without_limits_the_cost_alone_decides():
    def evaluate(x):
        return {"residual_rms": np.full(5, 1e-6 * (1.0 + (x[0] - 0.7) ** 2))}

    found = optimise(problem(minimise="residual_rms", limits=()), evaluate, evaluate, quiet)
    assert found.feasible and found.best.kept == ()
    assert found.best.values["x0"] == pytest.approx(0.7, abs=1e-2)


@pytest.mark.promise("campaigns-44")
def test_the_last_digits_of_a_processor_do_not_move_the_search():
    noise, rounding = 0.1 * gaussian(400, 6), np.random.default_rng(3)

    def exact(x):
        cost = 1e-6 * (1.0 + (x[0] - 0.7) ** 2 + 0.3 * x[1])
        return {"residual_rms": np.full(400, cost), "margin": 6.0 * x[0] + 4.0 * x[1] + noise}

    def other(x):
        return {name: column * (1.0 + 1e-14 * rounding.standard_normal()) for name, column in exact(x).items()}

    of = problem(
        variables=unit_cube(2), minimise="residual_rms", limits=(Limit("margin", 5.0, None, "test"),), evaluations=60
    )
    here, there = (optimise(of, evaluate, evaluate, quiet) for evaluate in (exact, other))
    assert [c.values for c in here.trace] == [c.values for c in there.trace]
    assert all(v == float(f"{v:.3e}") for c in here.trace for v in c.values.values())


def test_a_limit_from_above_and_one_from_both_sides():
    noise = 0.1 * gaussian(400, 6)

    def evaluate(x):
        return {"residual_rms": 10e-6 * (1.0 - x[0]) * (1.0 + noise), "margin": 10.0 * x[0] + noise}

    above = Limit("residual_rms", None, 4e-6, "test")
    between = Limit("margin", 2.0, 8.0, "test")
    found = optimise(problem(limits=(above, between)), evaluate, evaluate, quiet)
    exact = 1.0 - 0.4 / (1.0 + np.sort(noise)[-1 - 4])
    assert exact <= found.best.cost < exact + 3e-4
    assert found.bound_by == ("residual_rms",)
    assert found.best.kept[0].value == pytest.approx(4e-6, rel=2e-3)
    most = optimise(problem(limits=(above, between), minimise="-x0"), evaluate, evaluate, quiet)
    assert most.best.cost == pytest.approx(0.1 * (8.0 - np.sort(noise)[-1 - 4]), abs=5e-4)
    assert most.bound_by == ("margin",)
    assert most.best.kept[1].wanted == "margin >= 2 dB and <= 8 dB"


# ------------------------------------------------------------------------------------------------ what rows can say
@pytest.mark.promise("campaigns-40")
def test_the_share_kept_is_that_of_the_rows_with_clopper_and_pearsons_interval():
    found = optimise(problem(confidence=0.9), rising(), rising(seed=1), quiet)
    kept, rows = found.best.kept[0], rising()(np.array([found.best.cost]))["margin"]
    hits = int(np.sum(rows >= 3.0))
    assert hits == 360
    assert kept.share.value == hits / 400
    assert kept.share.low == pytest.approx(beta.ppf(0.025, hits, 401 - hits), abs=1e-9)
    assert kept.share.high == pytest.approx(beta.ppf(0.975, hits + 1, 400 - hits), abs=1e-9)
    assert kept.value == np.sort(rows)[40]
    assert kept.excess == pytest.approx(kept.value - 3.0)
    other = rising(seed=1)(np.array([found.best.cost]))["margin"]
    assert found.fresh.kept[0].share.value == np.mean(other >= 3.0) != kept.share.value
    assert found.fresh.values == found.best.values


def test_failed_rows_have_missed_every_limit():
    def some_failed(x, share):
        margin = rising()(x)["margin"]
        margin[: int(share * 400)] = np.nan
        return {"margin": margin}

    few = optimise(problem(confidence=0.9), lambda x: some_failed(x, 0.05), lambda x: some_failed(x, 0.05), quiet)
    none = optimise(problem(confidence=0.9), rising(), rising(), quiet)
    # 20 of the 40 rows that may miss the limit have failed
    left = np.sort(gaussian(400, 0)[20:])[20]
    assert few.best.cost == pytest.approx((3.0 - left) / 10.0, abs=5e-4)
    assert few.best.cost > none.best.cost + 0.01
    many = optimise(problem(confidence=0.9), lambda x: some_failed(x, 0.25), never, quiet)
    assert not many.feasible
    assert many.reason == "no candidate keeps margin >= 3 dB in 90 % of rows; the best has 75 %"


def test_rows_with_weights_count_by_them():
    """Rows from a wider distribution, weighted back, lead to the closed form of the narrow one."""
    noise = 2.0 * gaussian(20000, 11)
    weight = norm.pdf(noise) / norm.pdf(noise, scale=2.0)

    def evaluate(x):
        return {"weight": weight, "margin": 10.0 * x[0] + noise}

    exact = (3.0 + norm.ppf(0.99)) / 10.0
    found = optimise(problem(), evaluate, evaluate, quiet)
    assert found.best.cost == pytest.approx(exact, abs=0.006)
    ignored = optimise(problem(), lambda x: {"margin": evaluate(x)["margin"]}, evaluate, quiet)
    assert ignored.best.cost > exact + 0.15
    share = found.best.kept[0].share
    assert share.value == pytest.approx(0.99, abs=5e-4)
    assert share.low < 0.99 < share.high + 1e-3


@pytest.mark.promise("campaigns-42")
def test_an_optimum_that_leans_on_its_rows_is_told():
    found = optimise(problem(), rising(), rising(rows=4000, seed=5, spread=1.6), quiet)
    assert found.feasible and not found.confirmed and found.warnings == ()
    share = found.fresh.kept[0].share
    assert share.high < 0.99
    headline, said = optimum_text(found).splitlines()[:2]
    assert headline == (
        f"NOT CONFIRMED: least x0: {found.best.cost:.3g}, with each limit kept by at least 99 % of the searched rows"
    )
    assert said == (
        f"Fresh rows keep margin ≥ 3 dB in {100 * share.value:.4g} % ({100 * share.low:.4g} to "
        f"{100 * share.high:.4g} %), which is less often than the 99 % wanted; {SLACK}."
    )
    good = optimise(problem(), rising(), rising(rows=400, seed=5, spread=0.9), quiet)
    assert good.confirmed and good.fresh.feasible
    assert optimum_text(good).splitlines()[1] == "Fresh rows agree."


@pytest.mark.promise("campaigns-42")
def test_fresh_rows_that_fall_short_by_chance_agree_within_their_interval():
    found = optimise(problem(), rising(), rising(seed=5, spread=1.1), quiet)
    share = found.fresh.kept[0].share
    assert share.value < 0.99 < share.high
    assert not found.fresh.feasible and found.confirmed
    headline, said = optimum_text(found).splitlines()[:2]
    assert headline.startswith("least x0: ")
    assert said == (
        f"Fresh rows keep margin ≥ 3 dB in {100 * share.value:.4g} % ({100 * share.low:.4g} to "
        f"{100 * share.high:.4g} %), below 99 %: this agrees within its interval; {SLACK}."
    )


@pytest.mark.promise("campaigns-43")
def test_the_check_is_no_toss_of_a_coin():
    """Of optima on a limit fresh rows fall short as often as not (52 % of 2000 with 400 rows); 85 % are confirmed.

    The rest are those whose own rows were so mild that it shows.
    """
    times = 30 if os.environ.get("MICRORAD_ENDURANCE") else 15
    founds = [optimise(problem(evaluations=16), rising(seed=s), rising(seed=1000 + s), quiet) for s in range(times)]
    short = sum(not found.fresh.feasible for found in founds)
    confirmed = sum(found.confirmed for found in founds)
    assert 0.26 * times <= short <= 0.74 * times
    assert 0.76 * times <= confirmed and confirmed > times - short + 0.13 * times
    worse = [
        optimise(problem(evaluations=16), rising(seed=s), rising(4000, s, spread=1.5), quiet)
        for s in range(times if times == 30 else 5)
    ]
    assert not any(found.confirmed for found in worse)


def test_fresh_rows_that_cannot_be_drawn_leave_the_optimum():
    def refuses(_):
        raise CampaignError("row 7 is no mission")

    found = optimise(problem(), rising(), refuses, quiet)
    assert found.feasible and found.fresh is None
    assert found.warnings == ("the optimum could not be checked with fresh rows: row 7 is no mission",)
    assert not found.confirmed
    assert optimum_text(found).splitlines()[1] == "It has not been checked with fresh rows."


def test_fresh_rows_that_all_fail_refuse_the_optimum():
    asked = problem(minimise="-margin", limits=())
    found = optimise(asked, rising(), lambda x: {"margin": np.full(400, np.nan)}, quiet)
    assert found.feasible and not found.confirmed
    assert optimum_text(found).splitlines()[1] == "Fresh rows refuse it: no row has a margin."
    assert optimise(asked, rising(), rising(seed=1), quiet).confirmed


# ------------------------------------------------------------------------------------------------------- no optimum
def test_an_infeasible_problem_says_what_cannot_be_kept_and_how_near_it_came():
    found = optimise(problem(), rising(slope=5.0), never, quiet)
    share = np.mean(5.0 + gaussian(400, 0) >= 3.0)
    assert not found.feasible and found.fresh is None
    assert found.best.cost == pytest.approx(1.0, abs=1e-3)
    assert found.reason == f"no candidate keeps margin >= 3 dB in 99 % of rows; the best has {100 * share:.4g} %"
    assert found.bound_by == ("margin", "x0 at its high")
    assert optimise(problem(), rising(slope=7.0), rising(slope=7.0), quiet).feasible


@pytest.mark.parametrize(("residual", "binds"), [(5.02e-6, False), (10.1e-6, True)])
def test_a_small_value_that_no_variable_moves_is_not_taken_for_one_on_its_limit(residual, binds):
    still = Limit("residual_quantile", None, 10e-6, "test")

    def evaluate(x):
        return rising()(x) | {"residual_quantile": np.full(400, residual)}

    found = optimise(problem(limits=(MARGIN, still)), evaluate, evaluate, quiet)
    assert found.feasible is not binds
    assert found.bound_by == (("residual_quantile",) if binds else ("margin",))


def test_a_limit_that_all_candidates_are_on_and_none_misses_binds_nothing():
    def evaluate(x, lost):
        return rising()(x) | {"lost_share": np.full(400, 0.0 if x[0] > lost else 1e-3)}

    limits = (MARGIN, Limit("lost_share", None, 0.0, "test"))
    never_lost = optimise(problem(limits=limits), *[lambda x: evaluate(x, -1.0)] * 2, quiet)
    often_lost = optimise(problem(limits=limits), *[lambda x: evaluate(x, 0.8)] * 2, quiet)
    assert never_lost.bound_by == ("margin",)
    assert often_lost.bound_by == ("lost_share",)
    assert often_lost.best.cost > 0.8 > never_lost.best.cost


def test_a_limit_by_which_the_first_look_saw_no_finite_value_keeps_its_scale():
    def evaluate(x):
        return rising()(x) | {"residual_quantile": np.full(400, 5e-6 if x[0] < 0.56 else np.inf)}

    still = Limit("residual_quantile", None, 10e-6, "test")
    variable = Variable("x0", "", 0.5, 100.0)
    found = optimise(problem(variables=(variable,), limits=(MARGIN, still)), evaluate, evaluate, quiet)
    assert found.feasible
    assert "residual_quantile" not in found.bound_by


def test_the_reason_names_the_share_of_the_limit_that_is_missed_alone():
    noise = 0.1 * gaussian(400, 6)

    def evaluate(x):
        return {"margin": 10.0 + noise, "answer_margin": 3.0 * x[0] - 3.0 + noise}

    limits = (Limit("margin", 5.0, None, "test"), Limit("answer_margin", 0.0, None, "test"))
    found = optimise(problem(limits=limits), evaluate, never, quiet)
    share = 100.0 * np.mean(evaluate([found.best.values["x0"]])["answer_margin"] >= 0.0)
    assert found.reason == f"no candidate keeps answer_margin >= 0 dB in 99 % of rows; the best has {share:.4g} %"


def test_limits_that_exclude_each_other():
    noise = 0.1 * gaussian(400, 6)

    def evaluate(x):
        return {"margin": 10.0 * x[0] + noise, "answer_margin": 8.0 - 10.0 * x[0] + noise}

    limits = (Limit("margin", 5.0, None, "test"), Limit("answer_margin", 5.0, None, "test"))
    found = optimise(problem(limits=limits), evaluate, never, quiet)
    assert not found.feasible
    assert found.reason.startswith("no candidate keeps margin >= 5 dB and answer_margin >= 5 dB in 99 % of rows")
    assert found.reason.endswith("the best has 0 % and 0 %")
    assert 0.25 < found.best.cost < 0.55


def test_refused_candidates_are_counted_and_the_search_goes_round_them():
    """No mission above 0.6, where the cost would be least."""

    def evaluate(x):
        if x[0] > 0.6:
            raise CampaignError(f"x0 = {x[0]:g} is no mission")
        return rising()(x)

    found = optimise(problem(minimise="-x0"), evaluate, evaluate, quiet)
    assert found.feasible
    assert 0.598 < found.best.cost <= 0.6
    refused = [c for c in found.trace if c.refused]
    assert found.refused == len(refused) > 0
    assert all(c.values["x0"] > 0.6 and math.isnan(c.cost) and c.kept == () for c in refused)
    assert refused[0].refused == f"x0 = {refused[0].values['x0']:g} is no mission"
    assert len(found.trace) == found.evaluations


def test_only_refused_candidates():
    def refuses(x):
        raise CampaignError("a mirror of no mission")

    found = optimise(problem(), refuses, never, quiet)
    assert not found.feasible and found.best is None and found.fresh is None
    assert found.reason == (
        f"no candidate is a mission: all {found.refused} were refused, the last because a mirror of no mission"
    )
    assert found.evaluations == found.refused == 12  # the first look alone


def test_rows_that_all_fail_are_refused_where_their_mean_is_the_cost():
    def evaluate(x):
        margin = rising()(x)["margin"]
        return {"margin": margin if x[0] < 0.7 else np.full(400, np.nan)}

    found = optimise(problem(minimise="-margin"), evaluate, evaluate, quiet)
    assert 0.69 < found.best.values["x0"] < 0.7
    assert {c.refused for c in found.trace} == {"", "no row has a margin"}


def test_infinite_outputs_do_not_lead_astray():
    """A link that is never closed has a margin of minus infinity."""

    def evaluate(x):
        return {"margin": rising()(x)["margin"] if x[0] > 0.3 else np.full(400, -np.inf)}

    found = optimise(problem(), evaluate, evaluate, quiet)
    plain = optimise(problem(), rising(), rising(), quiet)
    assert found.best.cost == pytest.approx(plain.best.cost, abs=2e-3)


# ---------------------------------------------------------------------------------------------------------- in words
def test_the_text_heads_its_columns_and_says_what_each_number_is():
    found = optimise(problem(confidence=0.9), rising(), rising(seed=1), quiet)
    best, fresh = found.best.kept[0], found.fresh.kept[0]
    lines = [line.split("  ") for line in optimum_text(found).splitlines()]
    rows = [[cell.strip() for cell in line if cell.strip()] for line in lines]
    assert ["variable", "value", "searched range"] in rows
    assert ["x0", f"{found.best.cost:.3g}", "0 to 1"] in rows
    at = rows.index(["limit", "rows", "value in the deciding row", "share that keeps it", "95 % interval"])
    assert rows[at + 1][:4] == ["margin ≥ 3 dB", "searched", f"{best.value:.2f} dB", "90 %"]
    assert rows[at + 1][4] == f"{100 * best.share.low:.4g} to {100 * best.share.high:.4g} %"
    assert rows[at + 2][1:4] == ["fresh", f"{fresh.value:.2f} dB", f"{100 * fresh.share.value:.4g} %"]
    assert rows[at + 3] == ["deciding row: no row is worse but the 10 % that may miss the limit."]
    assert rows[at + 4] == ["90 % (optimise.confidence) is the share of the rows that is to keep each limit."]
    # columns stand below each other
    table = optimum_text(found).splitlines()[at : at + 3]
    assert len({line.index(word) for line, word in zip(table, ("rows", "searched", "fresh"), strict=True)}) == 1


def test_the_text_says_which_statistic_an_output_as_cost_is():
    def said(**changes):
        return optimum_text(optimise(problem(limits=(), **changes), rising(), rising(seed=1), quiet))

    mean = said(minimise="-margin")
    assert mean.startswith("largest margin (mean over the rows): ")
    assert re.search(r"\nmargin \(mean over the rows\): \d+\.\d\d dB of the searched rows, \d+\.\d\d dB of fresh", mean)
    assert "deciding row" not in mean and "There is no limit for fresh rows to check." in mean
    own = said(minimise="x0")
    assert own.startswith("least x0: ") and "of the rows" not in own


def test_a_deciding_row_that_failed_is_called_so():
    found = optimise(problem(), lambda x: {"margin": np.full(400, np.nan)}, never, quiet)
    assert re.search(r"\nmargin ≥ 3 dB  searched  failed  +0 %", optimum_text(found))
    assert optimum_text(found).startswith("NO DESIGN KEEPS THE LIMITS: ")
    assert "nan" not in optimum_text(found)


def test_data_has_the_check():
    found = optimise(problem(), rising(), rising(seed=5, spread=1.1), quiet)
    data = optimum_data(found)
    assert data["confirmed"] is True and data["fresh"]["feasible"] is False
    assert data["check"] == fresh_rows_sentence(found)
    none = optimum_data(optimise(problem(), rising(slope=1.0), never, quiet))
    assert none["confirmed"] is False and none["check"] == ""


# ---------------------------------------------------------------------------------------------------------- the rest
def test_the_same_seed_gives_the_same_candidates_and_another_does_not():
    def trace(seed):
        asked = problem(variables=unit_cube(2), seed=seed, evaluations=50)
        return [tuple(c.values.values()) for c in optimise(asked, rising(), rising(), quiet).trace]

    one = trace(1)
    assert one == trace(1)
    assert one != trace(2)
    assert len(set(one)) == len(one)


def test_progress_counts_up_to_the_candidates_looked_at():
    said = []
    found = optimise(problem(), rising(), rising(), lambda *what: said.append(what))
    assert [done for done, _, _ in said] == list(range(1, found.evaluations + 1))
    assert {total for _, total, _ in said} == {50}
    assert found.evaluations <= 100
    assert said[-1][2] == f"best x0 {found.best.cost:.4g}"
    told = []
    optimise(problem(), rising(slope=1.0), never, lambda *what: told.append(what[2]))
    assert set(told) == {"no candidate keeps the limits yet"}


def test_bounds_hold_and_wide_ones_are_searched_by_ratio():
    wide, narrow = Variable("x0", "", 1e-3, 10.0), Variable("x0", "", 1.0, 9.0)
    assert wide.log and not narrow.log and not Variable("x0", "", 0.0, 100.0).log
    assert wide.at(0.5) == pytest.approx(0.1) and narrow.at(0.5) == pytest.approx(5.0)
    assert (wide.at(0.0), wide.at(1.0), narrow.at(0.0), narrow.at(1.0)) == (1e-3, 10.0, 1.0, 9.0)
    noise = gaussian(400, 0)
    asked = problem(variables=(wide,))
    found = optimise(asked, *[lambda x: {"margin": 10.0 + 10 * math.log10(x[0]) + noise}] * 2, quiet)
    exact = 10.0 ** ((3.0 - np.sort(noise)[4] - 10.0) / 10.0)
    assert exact <= found.best.cost < exact * 1.002
    assert all(1e-3 <= c.values["x0"] <= 10.0 for c in found.trace)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"evaluations": 15}, "optimise.evaluations: 15 are too few for 1 variable; give at least 16"),
        (
            {"confidence": 0.999},
            "optimise.rows: 400 rows cannot tell whether 99.9 % of them keep a limit; draw at least 1000",
        ),
        (
            {"confidence": 0.99999},
            "optimise.rows: 400 rows cannot tell whether 99.999 % of them keep a limit; draw at least 100000",
        ),
        (
            {"limits": (ANSWER,)},
            "the rows have no output answer_margin, which the optimisation needs; add it to keep",
        ),
    ],
)
def test_what_cannot_be_searched_is_refused(changes, message):
    with pytest.raises(CampaignError) as error:
        optimise(problem(**changes), rising(), never, quiet)
    assert str(error.value) == message


def test_the_least_that_is_not_refused():
    assert optimise(problem(evaluations=16), rising(), rising(), quiet).feasible
    assert optimise(problem(confidence=0.999), rising(rows=1000), rising(rows=1000), quiet).evaluations > 0


@pytest.mark.promise("campaigns-3")
def test_help_says_what_the_number_of_threads_is_of(call):
    said = {name: " ".join(call("campaign", name, "--help").out.split()) for name in ("run", "resume", "optimise")}
    assert "--threads N Threads of this process [default: one a core]" in said["optimise"]
    assert all(
        "--threads N Processes of this machine [default: one a core]" in said[name] for name in ("run", "resume")
    )


# ------------------------------------------------------------------------------------------------------ its candidates
APERTURES = """
[grid]
"communication.distance" = ["36000 km", "40000 km"]
[optimise]
minimise = "terminals.leo_aperture"
confidence = 0.9
rows = 16
evaluations = 20
[optimise.variables."terminals.leo_aperture"]
low = "3 cm"
high = "12 cm"
"""


@pytest.mark.promise("campaigns-40", "campaigns-60")
def test_candidates_have_the_same_draws_in_the_first_cell_of_a_grid(tmp_path):
    campaign = loaded(tmp_path, HEAD + POWER + APERTURES, whole=False)
    rows = _CandidateRows(campaign, 16, 1)
    (small, large, fresh) = (rows.columns([x], first)["margin"] for x, first in ((0.05, 0), (0.1, 0), (0.05, 16)))
    assert np.ptp(small) > 0.1
    np.testing.assert_allclose(large - small, large[0] - small[0], atol=1e-9)
    assert not set(fresh) & set(small)
    given = campaign.cells[0].file.mission.terminals.leo_aperture_m
    wanted = Evaluator(campaign, {}).rows(0, range(16), lambda: None).columns["margin"]
    other = Evaluator(campaign, {}).rows(1, range(16), lambda: None).columns["margin"]
    assert rows.columns([given])["margin"].tolist() == wanted.tolist() != other.tolist()


@pytest.mark.promise("campaigns-3")
@pytest.mark.parametrize("threads", [None, 3])
def test_candidates_are_computed_by_as_many_threads_as_are_asked_for_or_one_a_core(tmp_path, monkeypatch, threads):
    campaign, asked = loaded(tmp_path, HEAD + POWER + APERTURES, whole=False), []
    here = _CandidateRows(campaign, 16, 1).columns([0.05])["margin"]
    monkeypatch.setattr(
        in_threads, "ThreadPoolExecutor", lambda max_workers: asked.append(max_workers) or ThreadPoolExecutor(2)
    )
    monkeypatch.setattr(os, "cpu_count", lambda: 7)
    assert _CandidateRows(campaign, 16, threads).columns([0.05])["margin"].tolist() == here.tolist()
    assert asked == [threads or 7]


@pytest.mark.promise("campaigns-41")
def test_a_variable_that_touches_the_loop_has_its_controller_tuned_anew(tmp_path, monkeypatch):
    noise = "fine_pointing.optical_sensor.noise"
    text = (
        HEAD
        + POWER
        + LOOP
        + APERTURES.replace('"terminals.leo_aperture"]', f'"{noise}"]')
        .replace('minimise = "terminals.leo_aperture"', f'minimise = "{noise}"')
        .replace('"3 cm"', '"1 urad"')
        .replace('"12 cm"', '"9 urad"')
    )
    tuner = loops.ControllerTuner(loaded(tmp_path, text))
    monkeypatch.setattr(
        loops,
        "mission_loop",
        lambda file, table, seed: SimpleNamespace(tuned=lambda: [file.mission.fine_pointing.optical_sensor.noise_rad]),
    )
    first = tuner.tuned(0, {noise: 2e-6})
    assert first == [2e-6] and tuner.tuned(0, {noise: 3e-6}) == [3e-6]
    assert tuner.tuned(0, {noise: 2e-6, "communication.transmit_power": 4.0}) is first


@pytest.mark.promise("campaigns-41")
def test_it_searches_from_several_places(monkeypatch):
    searched, real = [], scipy.optimize.minimize

    def minimize(of, start, **how):
        searched.append((how["method"], tuple(start)))
        return real(of, start, **how)

    monkeypatch.setattr(scipy.optimize, "minimize", minimize)
    asked = problem(variables=unit_cube(2), minimise="residual_rms", limits=(), evaluations=200)
    optimise(asked, as_rows(two_wells), as_rows(two_wells), quiet)
    assert {method for method, _ in searched} == {"COBYQA"}
    assert len({start for _, start in searched}) > 2


# ------------------------------------------------------------------------------------------------ one candidate
def of_rows(limit, values, confidence, weight=None):
    """How rows with these margins stand to a limit."""
    rows = np.array(values, dtype=float)
    columns = {"margin": rows} | ({} if weight is None else {"weight": np.array(weight, dtype=float)})
    asked = problem(limits=(limit,), confidence=confidence, minimise="margin")
    return judged(asked, {"x0": 0.5}, columns)


@pytest.mark.parametrize(
    ("limit", "value", "excess"),
    [
        (Limit("margin", 3.0, None, ""), 2.0, -1.0),  # of five rows one may miss it: the second from below decides
        (Limit("margin", None, 3.0, ""), 4.0, -1.0),
        (Limit("margin", 2.0, 4.0, ""), 2.0, 0.0),  # 1 and 5 are one outside
        (Limit("margin", 2.0, None, ""), 2.0, 0.0),
        (Limit("margin", None, 4.0, ""), 4.0, 0.0),
        (Limit("margin", 1.5, None, ""), 2.0, 0.5),
    ],
)
def test_the_row_that_decides_is_the_first_that_may_not_miss_the_limit(limit, value, excess):
    found = of_rows(limit, [3.0, 1.0, 5.0, 2.0, 4.0], 0.8 if None in (limit.least, limit.most) else 0.6)
    (kept,) = found.kept
    assert (kept.value, kept.excess, kept.holds) == (value, excess, excess >= 0.0)
    assert (found.feasible, found.cost, found.refused) == (kept.holds, 3.0, "")


def test_weights_move_the_row_that_decides_and_a_row_without_a_result_has_missed():
    limit = Limit("margin", 3.0, None, "")
    assert of_rows(limit, [1.0, 2.0, 3.0, 4.0], 0.75, [1.0, 1.0, 1.0, 1.0]).kept[0].value == 2.0
    assert of_rows(limit, [1.0, 2.0, 3.0, 4.0], 0.75, [0.5, 0.4, 1.0, 2.1]).kept[0].value == 3.0
    lost = of_rows(limit, [9.0, math.nan, 3.0, 4.0], 0.75)
    assert lost.kept[0].value == 3.0 and lost.feasible and lost.kept[0].share.value == 0.75
    more = of_rows(limit, [9.0, math.nan, math.nan, 4.0], 0.75)
    assert more.kept[0].excess == -math.inf and math.isnan(more.kept[0].value) and not more.feasible
    none = of_rows(limit, [math.nan] * 4, 0.75)
    assert none.refused == "no row has a margin" and not none.feasible


@pytest.mark.parametrize(("rows", "confidence", "taken"), [(10, 0.9, True), (9, 0.9, False), (1000, 0.999, True)])
def test_as_many_rows_as_one_may_miss_of_are_enough(rows, confidence, taken):
    limit, values = Limit("margin", 0.0, None, ""), np.ones(rows)
    if taken:
        assert of_rows(limit, values, confidence).feasible
        return
    with pytest.raises(CampaignError, match=f"{rows} rows cannot tell whether 90 % of them .* draw at least 10"):
        of_rows(limit, values, confidence)
    asked = problem(limits=(), confidence=confidence, minimise="margin")
    assert judged(asked, {"x0": 0.5}, {"margin": values}).feasible  # without a limit nothing is to be told


def test_a_limit_agrees_from_the_end_of_its_interval_on_and_says_what_is_wanted():
    share = Interval(0.9, 0.85, 0.95, 0.95)
    kept = Kept(Limit("residual_quantile", None, 1e-5, ""), 9e-6, 1e-6, share)
    assert (kept.agrees(0.95), kept.agrees(0.951), kept.agrees(0.85)) == (True, False, True)
    assert kept.wanted == "residual_quantile <= 10 µrad"
    assert Kept(Limit("margin", 3.0, None, ""), 3.0, 0.0, share).wanted == "margin >= 3 dB"


@pytest.mark.parametrize(
    ("minimise", "name", "unit", "sign"),
    [
        ("x0", "x0", "", 1.0),
        ("-x0", "x0", "", -1.0),
        ("margin", "margin", "dB", 1.0),
        ("-margin", "margin", "dB", -1.0),
    ],
)
def test_a_cost_is_a_variable_or_the_mean_of_an_output_either_way(minimise, name, unit, sign):
    asked = problem(minimise=minimise, limits=())
    assert (asked.cost_name, asked.cost_unit, asked.sign) == (name, unit, sign)
    columns = {"margin": np.array([1.0, math.nan, 4.0]), "weight": np.array([3.0, 5.0, 1.0])}
    assert judged(asked, {"x0": 0.5}, columns).cost == (0.5 if name == "x0" else 1.75)


@pytest.mark.parametrize(
    ("numbers", "bounds", "width"),
    [
        ([0.0, 1.0, 2.0, 3.0, 4.0], (), 2.0),
        ([0.0, 1.0, 1.0, 1.0, 4.0], (), 4.0),  # the quartiles agree
        ([2.0, 2.0, -2.0 + 4.0], (), 2.0),
        ([-3.0, -3.0], (1.0, 5.0), 5.0),
        ([-3.0, -3.0], (1.0,), 3.0),
        ([math.inf, 1.0, 3.0, math.nan], (), 1.0),
        ([math.inf], (), 1.0),
        ([0.0, 0.0], (), 1.0),
        ([], (7.0,), 7.0),
    ],
)
def test_a_large_step_is_that_of_the_quartiles_or_what_is_left_of_it(numbers, bounds, width):
    assert search._spread(numbers, bounds) == width


def a_search(places):
    """A search whose known candidates are given by their place, cost and excess over one limit."""
    asked = problem(limits=(Limit("margin", 3.0, None, ""),))
    share = Interval(0.9, 0.8, 1.0, 0.95)
    made = search._Search(asked, never, quiet, cost_scale=2.0, scales=np.array([4.0]))
    for number, (place, cost, excess) in enumerate(places):
        kept = () if excess is None else (Kept(asked.limits[0], 3.0 + excess, excess, share),)
        candidate = Candidate({"x0": place}, cost, kept, "refused" if excess is None else "")
        made.known[bytes([number])] = np.array([place]), candidate
    return made


def test_the_best_is_the_cheapest_that_keeps_its_limits_or_misses_them_least():
    found = a_search([(0.1, 5.0, 0.0), (0.2, 4.0, 0.1), (0.3, 1.0, -0.1), (0.4, 0.0, None)])
    assert found.best().values == {"x0": 0.2}
    assert [c.values["x0"] for _, c in found.accepted] == [0.1, 0.2, 0.3]
    missed = a_search([(0.1, 1.0, -0.4), (0.2, 9.0, -0.2), (0.3, 0.0, None)])
    assert missed.best().values == {"x0": 0.2}
    assert a_search([(0.3, 0.0, None)]).best() is None
    known = missed.trace[0]
    assert missed.cost(known) == 0.5 and missed.excess(known).tolist() == [-0.1]
    assert missed.violation(known) == pytest.approx(0.1) and missed.score(known) == pytest.approx(0.5 + 1.0)
    far = a_search([(0.1, 1.0, -1e9), (0.2, 1.0, 1e9)])
    assert [far.excess(c).tolist() for c in far.trace] == [[-search.FARTHEST], [search.FARTHEST]]
    assert far.violation(far.trace[1]) == 0.0


@pytest.mark.parametrize(
    ("place", "excess", "missed", "names"),
    [
        (0.5, 0.079, True, ("margin",)),  # within 0.02 of the scale, which is 4
        (0.5, 0.081, True, ()),
        (0.5, 0.079, False, ()),  # no candidate missed it
        (0.019, 1.0, True, ("x0 at its low",)),
        (0.021, 1.0, True, ()),
        (0.981, 1.0, True, ("x0 at its high",)),
        (0.979, 1.0, True, ()),
        (0.0, 0.0, True, ("margin", "x0 at its low")),
    ],
)
def test_what_binds_an_optimum_is_near_and_has_kept_others_from_being_one(place, excess, missed, names):
    found = a_search([(place, 1.0, excess), (0.4, 0.5, -1.0 if missed else 1.0)])
    assert search._bound_by(found, found.trace[0]) == names


def test_searches_set_out_apart_from_the_most_promising_on():
    found = a_search([(0.5, 4.0, 1.0), (0.52, 2.0, 1.0), (0.9, 3.0, 1.0), (0.38, 1.0, 1.0), (0.1, 0.0, -40.0)])
    assert [float(place[0]) for place in found.starts()] == [0.38, 0.9, 0.1]
    assert [float(place[0]) for place in a_search([(0.38, 1.0, 1.0), (0.54, 2.0, 1.0)]).starts()] == [0.38, 0.54]


# --------------------------------------------------------------------------------------------- words of what was found
def kept_by(value, low, high, excess=1.0, limit=MARGIN):
    return Kept(limit, 3.5, excess, Interval(value, low, high, 0.95))


def found_with(best_kept=(), fresh_kept=(), **changes):
    """An optimum at x0 = 0.5 that costs as much, checked by fresh rows."""
    best = Candidate({"x0": 0.5}, 0.5, tuple(best_kept))
    given = {
        "problem": problem(),
        "best": best,
        "fresh": Candidate({"x0": 0.5}, 0.25, tuple(fresh_kept)),
        "bound_by": (),
        "evaluations": 12,
        "refused": 0,
        "reason": "",
        "warnings": (),
        "trace": (),
    }
    return search.Optimum(**given | changes)


def test_without_a_candidate_the_text_has_the_reason_and_the_count_alone():
    assert optimum_text(found_with(best=None, fresh=None, reason="none is a mission", refused=12)).splitlines() == [
        "NO DESIGN KEEPS THE LIMITS: none is a mission",
        "",
        "12 candidates, 12 of them no mission",
    ]


def test_the_text_ends_with_what_binds_the_count_and_the_warnings():
    plain = optimum_text(found_with())
    assert "Bound by" not in plain and plain.splitlines()[-1] == "12 candidates"
    assert "deciding row" not in plain and "The best of the designs tried" not in plain
    said = optimum_text(found_with(bound_by=("x0", "margin"), refused=1, warnings=("one", "two"))).splitlines()
    assert said[-6:] == [
        "",
        "Bound by: x0, margin",
        "",
        "12 candidates, 1 of them no mission",
        "warning: one",
        "warning: two",
    ]


def test_a_design_that_misses_a_limit_stands_as_the_best_of_those_tried():
    missed = found_with([kept_by(0.5, 0.4, 0.6, -1.0)], fresh=None, reason="too few rows")
    said = optimum_text(missed).splitlines()
    assert said[:3] == ["NO DESIGN KEEPS THE LIMITS: too few rows", "", "The best of the designs tried:"]
    assert "It has not been checked with fresh rows." not in said
    assert re.search(r"\nmargin ≥ 3 dB  searched  3\.50 dB +50 % +40 to 60 %\n", optimum_text(missed))
    assert optimum_data(missed)["check"] == ""
    assert optimum_data(missed)["fresh"] is None


ERROR = Limit("residual_quantile", None, 1e-5, "test")
SHORT, LOW = (kept_by(0.98, 0.97, 0.995, -1.0), kept_by(0.5, 0.4, 0.6, -1.0, ERROR))


WITHIN = f"below 99 %: this agrees within its interval; {SLACK}."
LESS = f"which is less often than the 99 % wanted; {SLACK}."


@pytest.mark.parametrize(
    ("fresh", "said"),
    [
        ([], "There is no limit for fresh rows to check."),
        ([kept_by(0.999, 0.99, 1.0)], "Fresh rows agree."),
        ([kept_by(0.99, 0.985, 0.99)], "Fresh rows agree."),
        ([SHORT], f"Fresh rows keep margin ≥ 3 dB in 98 % (97 to 99.5 %), {WITHIN}"),
        ([SHORT, LOW], f"Fresh rows keep residual_quantile ≤ 10 µrad in 50 % (40 to 60 %), {LESS}"),
        (
            [kept_by(0.5, 0.4, 0.6), LOW],
            "Fresh rows keep margin ≥ 3 dB in 50 % (40 to 60 %) and residual_quantile ≤ 10 µrad in 50 % (40 to 60 %), "
            + LESS,
        ),
        (
            [SHORT, kept_by(0.98, 0.97, 0.99, -1.0, ERROR)],
            "Fresh rows keep margin ≥ 3 dB in 98 % (97 to 99.5 %) and residual_quantile ≤ 10 µrad in 98 % (97 to 99 "
            f"%), {WITHIN}",
        ),
    ],
)
def test_fresh_rows_are_said_to_agree_to_the_end_of_their_interval(fresh, said):
    assert fresh_rows_sentence(found_with(fresh_kept=fresh)) == said


def test_what_an_output_costs_is_told_of_the_rows_that_were_searched_and_of_fresh_ones():
    asked = problem(minimise="-margin", limits=())
    searched = "\nmargin (mean over the rows): 0.50 dB of the searched rows"
    both = optimum_text(found_with(problem=asked))
    assert f"{searched}, 0.25 dB of fresh rows\n" in both
    assert both.startswith("largest margin (mean over the rows): 0.50 dB\n")
    for fresh in (None, Candidate({"x0": 0.5}, math.nan, (), "no row has a margin")):
        alone = optimum_text(found_with(problem=asked, fresh=fresh))
        assert f"{searched}\n" in alone and "of fresh rows" not in alone
        assert alone.startswith("NOT CONFIRMED: largest margin")
    assert "mean over" not in optimum_text(found_with(problem=problem(limits=())))


def test_a_variable_has_its_unit_and_the_range_it_was_searched_in():
    asked = problem(variables=(Variable("x0", "m", 0.01, 2.0),), limits=())
    said = optimum_text(found_with(problem=asked))
    assert said.startswith("least x0: 500 mm\n")
    assert re.search(r"\nx0 +500 mm +10 mm to 2 m\n", said)
    assert re.search(r"\nx0 +0\.5 +0 to 1\n", optimum_text(found_with()))


RATE = Limit("data_rate", None, 622.08e6, "test")
RMS = Limit("residual_rms", 2.5e-6, 12.5e-6, "test")


def kept(excess, share=0.5, limit=MARGIN, high=1.0):
    return Kept(limit, excess, excess, Interval(share, 0.0, high, 0.95))


def test_a_limit_in_words_has_each_side_in_its_unit():
    said = [kept(0.0, limit=limit).wanted for limit in (MARGIN, RATE, RMS, Limit("outage", None, 0.0125, ""))]
    assert said == [
        "margin >= 3 dB",
        "data_rate <= 622.1 Mbit/s",
        "residual_rms >= 2.5 µrad and <= 12.5 µrad",
        "outage <= 0.0125",
    ]


def test_weighted_rows_of_which_one_failed_judge_a_candidate_by_the_row_that_decides():
    """Of two limits the second has two sides; a row that failed has missed all, and weighs what it weighs."""
    asked = problem(
        variables=(Variable("a", "W", 1.0, 2.0), Variable("b", "m", 1.0, 2.0)),
        minimise="-data_rate",
        limits=(Limit("margin", 3.0, None, ""), Limit("data_rate", 2.0, 8.0, "")),
        confidence=0.7,
    )
    columns = {
        "margin": np.array([4.0, 2.5, 3.5, math.nan, 7.0]),
        "data_rate": np.array([5.0, 7.0, 1.75, 6.0, 9.5]),
        "weight": np.array([1.0, 0.5, 2.0, 0.25, 1.25]),
    }
    found = judged(asked, {"a": 1.5, "b": 1.25}, columns)
    assert found.values == {"a": 1.5, "b": 1.25} and found.refused == ""
    assert found.cost == pytest.approx((5.0 + 3.5 + 3.5 + 1.5 + 11.875) / 5.0, rel=1e-12)
    margin, rate = found.kept
    # 30 % of the weight of 5 may miss: those of the failed row and of 2.5 dB are 15 %, and 3.5 dB is the next
    assert (margin.value, margin.excess, margin.holds) == (3.5, 0.5, True)
    # 9.5 misses by 1.5 and 1.75 by 0.25: 25 % and 40 % more, so the second of them decides
    assert (rate.value, rate.excess, rate.holds) == (1.75, -0.25, False)
    assert not found.feasible and not Candidate({}, 1.0, (margin,), "refused").feasible
    assert margin.agrees(margin.share.high) and not margin.agrees(margin.share.high + 1e-9)
    assert (asked.cost_name, asked.cost_unit, asked.sign) == ("data_rate", "bit/s", -1.0)
    assert (problem(minimise="x0").cost_unit, problem(minimise="x0").sign) == ("", 1.0)


def test_a_candidate_whose_cost_no_row_has_is_refused():
    asked = problem(minimise="data_rate", limits=(), confidence=0.5)
    found = judged(asked, {"x0": 0.5}, {"data_rate": np.array([math.nan, math.nan])})
    assert (found.refused, found.kept, found.feasible) == ("no row has a data_rate", (), False)
    assert judged(asked, {"x0": 0.5}, {"data_rate": np.array([math.nan, 2.0])}).cost == 2.0


def searching(evaluate=None, **changes):
    changes = {"limits": (MARGIN, RATE), "variables": unit_cube(2), "evaluations": 40} | changes
    return search._Search(problem(**changes), evaluate, quiet)


def test_costs_and_excesses_are_told_over_their_scales_and_cut_off():
    of = searching(minimise="-x0")
    of.cost_scale, of.scales = 4.0, np.array([2.0, 1e6])
    one = Candidate({"x0": 3.0}, 3.0, (kept(-3.0, 0.25), kept(2e6, 0.75)))
    assert (of.cost(one), of.excess(one).tolist(), of.violation(one)) == (-0.75, [-1.5, 2.0], 1.5)
    assert of.score(one) == -0.75 + 10.0 * 1.5
    both = Candidate({"x0": 3.0}, 1e9, (kept(-3.0, 0.25), kept(-2e6, 0.75)))
    assert (of.cost(both), of.violation(both)) == (-1e6, 2.5)
    far = Candidate({}, -1e9, (kept(-1e9), kept(math.inf)))
    assert (of.cost(far), of.excess(far).tolist()) == (1e6, [-10.0, 10.0])
    assert of._order(one) == (1.5, -1.0, -3.0)
    assert of._order(Candidate({}, 3.0, (kept(0.0), kept(1.0)))) == (0.0, 0.0, -3.0)


def test_the_best_keeps_all_limits_at_the_least_cost_else_misses_them_least_with_the_larger_share():
    of = searching()
    places = [np.array([0.1 * k, 0.0]) for k in range(5)]

    def best(*candidates):
        of.known = {bytes([k]): each for k, each in enumerate(zip(places, candidates, strict=False))}
        return of.best()

    good = [Candidate({}, cost, (kept(0.0), kept(1.0))) for cost in (3.0, 2.0, 4.0)]
    missed = Candidate({}, 0.5, (kept(-0.25, 0.75), kept(1.0)))
    alike = Candidate({}, 0.75, (kept(-0.25, 0.875), kept(1.0)))
    refused = Candidate({}, math.nan, (), "no mission")
    assert best(good[0], missed, good[1], refused, good[2]) is good[1]
    assert of._so_far() == "best x0 2"
    assert best(missed, refused, alike) is alike
    assert of._so_far() == "no candidate keeps the limits yet"
    assert best(refused) is None and of._so_far() == "no candidate keeps the limits yet"
    assert [of.trace, of.accepted] == [(refused,), []]


def test_searches_set_out_from_the_most_promising_places_that_are_not_close_together():
    of = searching(limits=())
    far = 0.15 * math.sqrt(2.0)
    places = [(0.5, 0.5), (0.5, 0.5 + 0.99 * far), (0.5, 0.5 - 1.01 * far), (0.0, 0.0), (0.02, 0.01)]
    costs = [3.0, 1.0, 2.0, 5.0, 4.0]
    for number, (place, cost) in enumerate(zip(places, costs, strict=True)):
        of.known[bytes([number])] = np.array(place), Candidate({}, cost, ())
    assert [tuple(each) for each in of.starts()] == [places[1], places[2], places[4]]


def test_a_refused_place_is_told_its_neighbours_numbers_and_how_far_that_is():
    def evaluate(x):
        if x[0] > 0.5:
            raise CampaignError("too much")
        return {"margin": np.full(4, 3.0 + x[0]), "data_rate": np.full(4, 600e6 + 1e7 * x[1])}

    of = searching(evaluate, confidence=0.5)
    of.cost_scale, of.scales = 2.0, np.array([0.5, 1e7])
    near = of._numbers(np.array([0.4, 0.5]))
    of._numbers(np.array([0.1, 0.25]))
    assert near.tolist() == pytest.approx([0.2, 0.8 - 1e-4, 1.708 - 1e-4], abs=1e-9)
    away = math.hypot(0.3, 0.1)
    told = of._numbers(np.array([0.7, 0.6]))
    wanted = [0.2 + 10.0 * away, 0.8 - 1e-4 - away, 1.708 - 1e-4 - away]
    assert told.tolist() == pytest.approx(wanted, abs=1e-9)
    assert told.tolist() == np.round(told, 9).tolist()
    refused = of.trace[-1]
    assert (refused.refused, refused.values, refused.kept) == ("too much", {"x0": 0.7, "x1": 0.6}, ())
    assert math.isnan(refused.cost) and len(of.accepted) == 2


def test_no_candidate_is_looked_at_twice_nor_beyond_the_evaluations():
    looked, told = [], []

    def evaluate(x):
        looked.append(x.tolist())
        return {"margin": np.full(4, 5.0)}

    of = search._Search(problem(limits=(), evaluations=2), evaluate, lambda *what: told.append(what))
    first = of.at(np.array([0.12341]))
    assert of.at(np.array([0.12344])) is first is not of.at(np.array([-3.0]))
    assert looked == [[0.1234], [0.0]]
    assert told == [(1, 2, "best x0 0.1234"), (2, 2, "best x0 0")]
    with pytest.raises(search._SpentError):
        of.at(np.array([0.9]))
    assert of.at(np.array([0.0])) is of.trace[1]


@pytest.mark.parametrize(
    ("numbers", "bounds", "wide"),
    [
        ([1.0, 2.0, 4.0, 8.0, 16.0], (), 6.0),
        ([5.0, 5.0, 5.0, 5.0, 7.5], (), 2.5),  # the quartiles agree, and the extremes do not
        ([3.0, math.nan, math.inf, 3.0], (-8.0, 2.0), 8.0),
        ([-9.0, -9.0], (2.0,), 9.0),
        ([0.0], (), 1.0),
        ([], (0.25,), 0.25),
        ([math.nan], (), 1.0),
    ],
)
def test_what_is_wide_is_the_middle_half_else_all_else_the_size(numbers, bounds, wide):
    assert search._spread(numbers, bounds) == wide


def test_scales_are_those_of_cost_and_of_each_limit_over_the_range():
    def evaluate(x):
        return {"margin": np.full(4, 8.0 * x[0]), "data_rate": np.full(4, 622.08e6)}

    of = searching(evaluate, confidence=0.5, minimise="-margin")
    of.look_around()
    seen = [c.cost for c in of.trace]
    assert len(seen) == 10 and of.cost_scale == pytest.approx(float(np.ptp(np.quantile(seen, [0.25, 0.75]))))
    assert of.scales.tolist() == pytest.approx([of.cost_scale, 622.08e6])  # which is the bound where no row differs


def test_what_binds_an_optimum_are_limits_that_some_candidate_missed_and_ends_of_variables():
    of = searching(variables=unit_cube(3), limits=(MARGIN, RATE, ANSWER))
    of.scales = np.array([2.0, 1e7, 1.0])
    best = Candidate({}, 1.0, (kept(0.03), kept(1e5, limit=RATE), kept(0.5, limit=ANSWER)))
    other = Candidate({}, 1.0, (kept(-0.03), kept(1e5, limit=RATE), kept(-0.5, limit=ANSWER)))
    of.known = {b"0": (np.array([0.5, 0.0, 1.0]), other), b"1": (np.array([0.0199, 0.9, 0.9801]), best)}
    assert search._bound_by(of, best) == ("margin", "x0 at its low", "x2 at its high")


def test_why_there_is_no_optimum_names_each_limit_that_is_missed_with_its_share():
    refused = [Candidate({}, math.nan, (), words) for words in ("first", "last")]
    asked = problem(confidence=0.975)
    assert (
        search._reason(asked, None, refused) == "no candidate is a mission: all 2 were refused, the last because last"
    )
    best = Candidate({}, 1.0, (kept(-1.0, 0.8125), kept(1.0, 1.0, ANSWER), kept(-2.0, 0.25, RATE)))
    assert search._reason(asked, best, []) == (
        "no candidate keeps margin >= 3 dB and data_rate <= 622.1 Mbit/s in 97.5 % of rows; the best has 81.25 % "
        "and 25 %"
    )
    assert search._reason(asked, Candidate({}, 1.0, (kept(0.0),)), refused) == ""


def test_an_optimum_is_confirmed_by_fresh_rows_that_reach_each_share_and_refused_ones_confirm_nothing():
    asked = problem(confidence=0.9)
    best = Candidate({"x0": 0.5}, 0.5, (kept(0.0),))

    def confirmed(fresh):
        return search.Optimum(asked, best, fresh, (), 9, 0, "", (), (best,)).confirmed

    fresh = Candidate({}, 0.5, (kept(-1.0, 0.8, high=0.9), kept(1.0, 1.0)))
    assert confirmed(fresh)
    assert not confirmed(Candidate({}, 0.5, (kept(1.0, 1.0), kept(-1.0, 0.8, high=0.899))))
    assert not confirmed(None) and not confirmed(Candidate({}, math.nan, (), "refused"))
    assert confirmed(Candidate({}, 0.5, ()))


@pytest.mark.parametrize(("evaluations", "size", "least"), [(23, 2, 24), (31, 3, 32), (1, 7, 64)])
def test_too_few_evaluations_are_told_with_the_least_for_so_many_variables(evaluations, size, least):
    asked = problem(variables=unit_cube(size), evaluations=evaluations)
    with pytest.raises(CampaignError) as error:
        search._check(asked)
    words = f"{evaluations} are too few for {size} variables; give at least {least}"
    assert str(error.value) == f"optimise.evaluations: {words}"
    search._check(problem(variables=unit_cube(size), evaluations=least))


def test_fresh_rows_that_cannot_be_drawn_are_warned_of():
    best = Candidate({"x0": 0.25, "x1": 0.75}, 0.5, (kept(0.0),))
    asked = []

    def fresh(x):
        asked.append(x.tolist())
        raise CampaignError("no mission")

    found = search._on_fresh_rows(problem(), best, fresh)
    assert found == (None, ("the optimum could not be checked with fresh rows: no mission",))
    assert asked == [[0.25, 0.75]]
    assert search._on_fresh_rows(problem(), Candidate({}, 0.5, (kept(-1.0),)), never) == (None, ())
    assert search._on_fresh_rows(problem(), None, never) == (None, ())


def test_the_tables_of_a_file_of_links_alone_are_optimised_over_rows_of_their_own(monkeypatch):
    """Fresh rows come behind those of the search; the first cell counts, with values by their keys."""
    seen = []

    class Rows:
        def __init__(self, campaign, controllers, values, memory):
            seen.append((controllers, values, memory))

        def rows(self, cell, rows, beat):
            seen.append((cell, rows))
            each = np.arange(rows.start, rows.stop, dtype=float)
            return SimpleNamespace(columns={"weight": each + 0.5, "margin": -each, "other": each})

    monkeypatch.setattr(optimisation_campaign, "Evaluator", Rows)
    monkeypatch.setattr(optimisation_campaign, "ControllerTuner", lambda campaign: None)
    monkeypatch.setattr(optimisation_campaign, "touches_loop", lambda key, m: key == "b")
    campaign = SimpleNamespace(
        variables=(Variable("a", "m", 0.0, 1.0), Variable("c", "", 0.0, 1.0)),
        mission=SimpleNamespace(mission=None),
        table=SimpleNamespace(loop=None),
        outputs=[SimpleNamespace(name="margin")],
    )
    made = _CandidateRows(campaign, 20, 1)
    found = made.columns(np.array([0.25, 0.75]), first=20)
    assert list(found) == ["weight", "margin"]
    assert found["weight"].tolist() == [k + 0.5 for k in range(20, 40)] and found["margin"].tolist()[0] == -20.0
    assert seen[0] == ({}, {"a": 0.25, "c": 0.75}, {})
    assert [cell for cell, _ in seen[1:]] == [0] * 8
    assert [k for _, rows in seen[1:] for k in rows] == list(range(20, 40))
    campaign.variables = (Variable("b", "m", 0.0, 1.0),)
    assert _CandidateRows(campaign, 3, 1).memory is None
    few = _CandidateRows(campaign, 3, 1).columns(np.array([0.5]))
    assert few["margin"].tolist() == [0.0, -1.0, -2.0]


def test_a_file_without_an_optimisation_is_refused_by_its_name(monkeypatch):
    campaign = SimpleNamespace(table=SimpleNamespace(optimise=None, seed=3))
    monkeypatch.setattr(optimisation_campaign, "load_campaign", lambda file: campaign)
    with pytest.raises(CampaignError) as error:
        optimisation_campaign.optimise_campaign("a b.toml")
    assert str(error.value) == "a b.toml: there is no table [optimise] in it, so nothing says what to optimise"


# ------------------------------------------------------------------------------ several variables and limits, unlike
POWER_W, ANGLE = Variable("power", "W", 0.5, 4.0), Variable("angle", "rad", 1e-6, 9e-5)
RESIDUAL, BOTH = Limit("residual_quantile", None, 1e-5, ""), Limit("margin", 3.0, 9.5, "")


def two_variables(**changes):
    given = {"variables": (POWER_W, ANGLE), "minimise": "power", "limits": (BOTH, RESIDUAL), "confidence": 0.8}
    return problem(**given | changes)


def test_each_limit_is_judged_by_its_own_output_side_and_weights():
    columns = {
        "weight": np.array([0.5, 2.0, 1.0, 0.25, 1.25]),
        "margin": np.array([4.0, 9.25, 2.5, 10.5, 5.0]),
        "residual_quantile": np.array([9e-6, 1.5e-5, 4e-6, np.inf, 8e-6]),
        "data_rate": np.array([1.0, 2.0, 4.0, np.nan, 8.0]),
    }
    found = judged(two_variables(minimise="-data_rate"), {"power": 2.0, "angle": 5e-5}, columns)
    assert found.cost == pytest.approx((0.5 + 4.0 + 4.0 + 10.0) / 4.75)  # but for the row without one
    margin, residual = found.kept
    assert (margin.value, margin.excess) == (2.5, -0.5)  # 10.5 is a twentieth and may miss it, 2.5 with it may not
    assert (residual.value, residual.excess) == pytest.approx((1.5e-5, -5e-6))
    assert (margin.share.value, residual.share.value) == pytest.approx((0.75, 0.55))
    assert [k.limit for k in found.kept] == [BOTH, RESIDUAL] and not found.feasible
    assert margin.wanted == "margin >= 3 dB and <= 9.5 dB"
    assert judged(two_variables(minimise="-angle"), {"power": 2.0, "angle": 5e-5}, columns).cost == 5e-5
    with pytest.raises(CampaignError) as told:
        judged(two_variables(minimise="volume"), {"power": 2.0}, columns)
    assert str(told.value) == "the rows have no output volume, which the optimisation needs; add it to keep"


def kept_of(asked, *excess):
    values = (3.0, 1e-5)
    share = Interval(0.91, 0.8, 0.95, 0.95), Interval(0.234, 0.2, 0.3, 0.95)
    of = zip(asked.limits, values, excess, share, strict=True)
    return tuple(Kept(limit, value + each, each, one) for limit, value, each, one in of)


def two_search(asked, *candidates):
    """A search that knows these candidates: two numbers of the unit square, cost, excesses."""
    made = search._Search(asked, never, quiet, cost_scale=2.0, scales=np.array([4.0, 5e-6]))
    for number, (place, cost, *excess) in enumerate(candidates):
        values = {v.key: v.at(x) for v, x in zip(asked.variables, place, strict=True)}
        kept, refused = (kept_of(asked, *excess), "") if excess else ((), f"no mission {number}")
        made.known[bytes([number])] = np.array(place), Candidate(values, cost, kept, refused)
    return made


def test_a_search_is_told_of_all_limits_by_their_scales_and_of_a_refused_place_by_its_neighbour():
    made = two_search(
        two_variables(), ((0.1, 0.2), 7.0, 1.0, -2e-6), ((0.9, 0.7), 3.0, -2.0, 4e-6), ((0.9, 0.3), math.nan)
    )
    known = list(made.known.values())
    made.at = lambda place: next(c for p, c in known if p.tolist() == place.tolist())
    here = search.HEADROOM
    np.testing.assert_allclose(made._numbers(np.array([0.1, 0.2])), [3.5, 0.25 - here, -0.4 - here], atol=1e-9)
    np.testing.assert_allclose(made._numbers(np.array([0.9, 0.7])), [1.5, -0.5 - here, 0.8 - here], atol=1e-9)
    refused = [1.5 + 10.0 * 0.4, -0.5 - here - 0.4, 0.8 - here - 0.4]
    np.testing.assert_allclose(made._numbers(np.array([0.9, 0.3])), refused, atol=1e-9)
    most = two_search(two_variables(minimise="-power"), ((0.1, 0.2), 7.0, 1.0, -2e-6))
    assert most.cost(most.trace[0]) == -3.5
    assert search._distance(np.array([0.1, 0.2]), np.array([0.4, 0.6])) == pytest.approx(0.5)


@pytest.mark.parametrize(
    ("candidates", "minimise", "words"),
    [
        ([], "power", "no candidate keeps the limits yet"),
        ([((0.1, 0.2), 1.25, -1.0, 1e-6)], "power", "no candidate keeps the limits yet"),
        ([((0.1, 0.2), 1.25, 1.0, 1e-6), ((0.3, 0.2), 2.5, 1.0, 1e-6)], "power", "best power 1.25 W"),
        ([((0.1, 0.2), 1.25, 1.0, 1e-6), ((0.3, 0.2), 2.5, 1.0, 1e-6)], "-power", "best power 2.5 W"),
        ([((0.1, 0.2), 3.5e-5, 0.0, 0.0)], "angle", "best angle 35 µrad"),
        ([((0.1, 0.2), 6.2208e8, 1.0, 1e-6)], "-data_rate", "best data_rate 622.1 Mbit/s"),
    ],
)
def test_the_best_so_far_is_told_with_its_unit(candidates, minimise, words):
    assert two_search(two_variables(minimise=minimise), *candidates)._so_far() == words


@pytest.mark.parametrize(
    ("excess", "reason"),
    [
        ((0.0, 0.0), ""),
        ((1.0, -1e-9), "residual_quantile <= 10 µrad in 80 % of rows; the best has 23.4 %"),
        ((-1e-9, 1.0), "margin >= 3 dB and <= 9.5 dB in 80 % of rows; the best has 91 %"),
        (
            (-1.0, -1.0),
            "margin >= 3 dB and <= 9.5 dB and residual_quantile <= 10 µrad in 80 % of rows; the best has 91 % and "
            "23.4 %",
        ),
    ],
)
def test_why_there_is_no_optimum_names_each_limit_that_is_missed(excess, reason):
    asked = two_variables()
    best = Candidate({}, 1.0, kept_of(asked, *excess))
    assert search._reason(asked, best, []) == (f"no candidate keeps {reason}" if reason else "")
    refused = [Candidate({}, math.nan, (), f"it is {k}") for k in range(3)]
    assert search._reason(asked, None, refused) == (
        "no candidate is a mission: all 3 were refused, the last because it is 2"
    )


def test_what_binds_is_named_of_the_second_limit_and_variable_too():
    near = ((0.5, 0.985), 1.0, 0.5, 0.9e-7)
    far = ((0.2, 0.3), 2.0, 0.5, -1e-6)
    made = two_search(two_variables(), far, ((0.0, 0.0), math.nan), near)
    assert search._bound_by(made, made.best()) == ("residual_quantile", "angle at its high")
    other = two_search(two_variables(), ((0.01, 0.5), 1.0, 0.07, 4e-6), ((0.3, 0.4), 0.1, -1.0, 1e-6))
    assert search._bound_by(other, other.best()) == ("margin", "power at its low")


def test_candidates_are_drawn_in_parts_with_their_values_by_key_from_any_row_on(monkeypatch):
    from microrad.campaign.optimisation import campaign as optimisation

    made, asked = [], []

    class Rows:
        def __init__(self, campaign, controllers, values, memory):
            made.append((controllers, values, memory))

        def rows(self, cell, rows, beat):
            asked.append((cell, rows.start, rows.stop))
            row = np.arange(rows.start, rows.stop, dtype=float)
            return SimpleNamespace(columns={"row": row, "weight": row + 0.5, "margin": -row, "outage": row * 2.0})

    monkeypatch.setattr(optimisation, "Evaluator", Rows)
    monkeypatch.setattr(optimisation, "touches_loop", lambda key, mission: key == "angle")
    monkeypatch.setattr(optimisation, "ControllerTuner", lambda of: SimpleNamespace(tuned=lambda *given: given))
    outputs = [SimpleNamespace(name=name) for name in ("margin", "outage")]
    table, mission = SimpleNamespace(loop=object()), SimpleNamespace(mission=None)
    campaign = SimpleNamespace(variables=(POWER_W, ANGLE), outputs=outputs, table=table, mission=mission)
    rows = optimisation._CandidateRows(campaign, 21, 1)
    found = rows.columns(np.array([2.5, 3e-5]), first=100)
    values = {"power": 2.5, "angle": 3e-5}
    assert made == [({0: (0, values)}, values, None)]
    starts = [100, 102, 105, 107, 110, 113, 115, 118, 121]
    assert sorted(asked) == [(0, a, b) for a, b in itertools.pairwise(starts)]
    assert list(found) == ["weight", "margin", "outage"]
    np.testing.assert_array_equal(found["margin"], -np.arange(100.0, 121.0))
    np.testing.assert_array_equal(found["weight"], np.arange(100.5, 121.5))
    few = optimisation._CandidateRows(SimpleNamespace(**{**vars(campaign), "variables": (POWER_W,)}), 3, 1)
    few.campaign.table.loop = None
    asked.clear()
    few.columns(np.array([1.0]))
    few.columns(np.array([2.0]))
    assert sorted(asked) == [(0, k, k + 1) for k in (0, 0, 1, 1, 2, 2)]
    assert [each[:2] for each in made[1:]] == [({}, {"power": 1.0}), ({}, {"power": 2.0})]
    assert made[1][2] is made[2][2] is not None, "what moves no loop shares its runs"


@pytest.mark.parametrize(
    ("share", "words"),
    [
        (1.0, "100 %"),
        (0.99999, "99.999 %"),
        (0.99997, "99.997 %"),
        (0.999989, "99.9989 %"),
        (0.98765, "98.77 %"),
        (0.0, "0 %"),
        (math.nan, "nan %"),
    ],
)
def test_a_share_that_is_not_all_is_told_from_it(share, words):
    assert percent(share) == words


def test_a_band_of_shares_that_ends_below_all_says_so():
    kept = Kept(MARGIN, 3.1, 0.1, Interval(0.99997, 0.99991, 0.999995, 0.95))
    assert words._share_of(kept).endswith(" in 99.997 % (99.991 to 99.9995 %)")


def test_the_tables_of_a_file_become_a_problem_whose_fresh_rows_come_behind_the_first(monkeypatch):
    wanted = SimpleNamespace(minimise="-power", confidence=0.875, rows=24, evaluations=60)
    campaign = SimpleNamespace(
        table=SimpleNamespace(optimise=wanted, seed=41), variables=(POWER_W, ANGLE), limits=(BOTH, RESIDUAL)
    )
    made, asked = [], []

    class Rows:
        def __init__(self, *given):
            made.append(given)

        def columns(self, x, first=0):
            return x, first

    monkeypatch.setattr(optimisation_campaign, "load_campaign", lambda file: asked.append(file) or campaign)
    monkeypatch.setattr(optimisation_campaign, "_CandidateRows", Rows)
    monkeypatch.setattr(optimisation_campaign, "optimise", lambda *given: given)
    asked_of, rows, fresh, told = optimisation_campaign.optimise_campaign("a.toml", 3, quiet)
    assert (asked, made, told) == (["a.toml"], [(campaign, 24, 3)], quiet)
    assert asked_of == Problem((POWER_W, ANGLE), "-power", (BOTH, RESIDUAL), 0.875, 60, 41)
    assert (rows("x"), fresh("x")) == (("x", 0), ("x", 24))
    optimisation_campaign.optimise_campaign("a.toml")
    assert made[1] == (campaign, 24, None)


@pytest.mark.parametrize(
    ("least", "most", "words"),
    [
        (3.0625, None, "margin >= 3.062 dB"),
        (None, -2.5, "margin <= -2.5 dB"),
        (0.0, 0.5, "margin >= 0 dB and <= 0.5 dB"),
    ],
)
def test_each_side_of_a_limit_stands_with_its_sign_be_it_0_or_below(least, most, words):
    assert Kept(Limit("margin", least, most, ""), 0.0, 0.0, Interval(1.0, 0.9, 1.0, 0.95)).wanted == words


@pytest.mark.parametrize(
    ("values", "weight", "probability", "at"),
    [
        ([3.0, 1.0, 2.0, 4.0], [1.0, 1.0, 1.0, 1.0], 0.0, 1),
        ([3.0, 1.0, 2.0, 4.0], [1.0, 1.0, 1.0, 1.0], 0.25, 2),
        ([3.0, 1.0, 2.0, 4.0], [1.0, 1.0, 1.0, 1.0], 0.25 - 2e-9, 1),
        ([3.0, 1.0, 2.0, 4.0], [1.0, 1.0, 1.0, 1.0], 1.0, 3),
        ([3.0, 1.0, 2.0, 4.0], [6.0, 1.0, 2.0, 1.0], 0.5, 0),
        ([2.0, 1.0, 1.0, 1.0], [1.0, 3.0, 1.0, 2.0], 0.45, 2),
    ],
)
def test_the_row_that_decides_is_the_first_beyond_the_share_and_of_equal_ones_the_first(
    values, weight, probability, at
):
    from microrad.campaign.optimisation.candidates import _at

    assert _at(np.array(values), np.array(weight), probability) == at


def test_the_document_of_an_optimum_without_a_design_has_the_best_of_those_tried_and_says_that_none_is_feasible():
    missed = optimum_data(found_with([kept_by(0.5, 0.4, 0.6, -1.0)], fresh=None, reason="too few rows"))
    assert (missed["feasible"], missed["best"]["feasible"], missed["reason"]) == (False, False, "too few rows")
    assert optimum_data(optimise(problem(), rising(), rising(seed=5, spread=1.1), quiet))["feasible"] is True
