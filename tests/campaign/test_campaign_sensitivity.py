"""Sensitivities from given rows: against functions whose indices are known, and what must not be said."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy import stats

from microrad.campaign.records import Sensitivity
from microrad.campaign.statistics.sensitivity import (
    MOST_ROWS,
    _bins,
    _inside,
    _product_measure,
    _ratio,
    _terms,
    sensitivity,
)
from microrad.core.arrays import Floats
from truths import philox

G_FACTORS = np.array([0.0, 1.0, 4.5, 9.0, 99.0, 99.0])


def ishigami(x: Floats) -> Floats:
    angle = (2.0 * x - 1.0) * math.pi
    return np.asarray(np.sin(angle[:, 0]) * (1.0 + 0.1 * angle[:, 2] ** 4) + 7.0 * np.sin(angle[:, 1]) ** 2)


def g_function(x: Floats) -> Floats:
    return np.asarray(np.prod((np.abs(4.0 * x - 2.0) + G_FACTORS) / (1.0 + G_FACTORS), axis=1))


def g_indices() -> tuple[Floats, Floats]:
    """I. M. Sobol, Math. Comput. Simul. 55 (2001) 271."""
    alone = 1.0 / 3.0 / (1.0 + G_FACTORS) ** 2
    whole = np.prod(1.0 + alone) - 1.0
    return alone / whole, alone * np.prod(1.0 + alone) / (1.0 + alone) / whole


ISHIGAMI = (np.array([0.3139, 0.4424, 0.0]), np.array([0.5576, 0.4424, 0.2437]))
FUNCTIONS = {"ishigami": (ishigami, 3, ISHIGAMI), "g": (g_function, 6, g_indices())}


def of(x: Floats, y: Floats) -> Sensitivity:
    return sensitivity({f"x{at}": column for at, column in enumerate(x.T)}, y, "y")


def points(kind: str, seed: int, rows: int, inputs: int) -> Floats:
    """Random rows, or eight Sobol sets one after the other."""
    if kind == "random":
        return philox(seed).random((rows, inputs))
    sets = [stats.qmc.Sobol(inputs, rng=100 * seed + block).random(rows // 8) for block in range(8)]
    return np.concatenate(sets)


@pytest.mark.promise("campaigns-37", "campaigns-38")
@pytest.mark.parametrize("kind", ["random", "sobol"])
@pytest.mark.parametrize("name", FUNCTIONS)
def test_indices_of_known_functions(name: str, kind: str) -> None:
    function, inputs, (first, total) = FUNCTIONS[name]
    x = points(kind, 1, 2048, inputs)
    found = of(x, function(x))
    assert found.rows == 2048
    assert found.surrogate_q2 > 0.9
    assert found.note == ""
    assert_allclose([i.value for i in found.first.values()], first, atol=0.04)
    assert_allclose([i.value for i in found.total.values()], total, atol=0.05)
    if name == "ishigami":  # it has interactions
        assert found.total["x0"].low > found.first["x0"].high
        assert found.total["x2"].low > 0.2 > found.first["x2"].high


@pytest.mark.promise("campaigns-32")
@pytest.mark.parametrize(
    ("name", "kind"),
    [
        ("ishigami", "random"),
        ("g", "sobol"),
        pytest.param("ishigami", "sobol", marks=pytest.mark.endurance),
        pytest.param("g", "random", marks=pytest.mark.endurance),
    ],
)
def test_intervals_hold_the_known_indices(name: str, kind: str) -> None:
    function, inputs, exact = FUNCTIONS[name]
    held, times = np.zeros((2, inputs)), np.zeros(2)
    for seed in range(30):
        x = points(kind, seed, 256, inputs)
        found = of(x, function(x))
        for at, indices in enumerate((found.first, found.total)):
            times[at] += bool(indices)
            if indices:
                held[at] += [i.low - 1e-3 <= v <= i.high for i, v in zip(indices.values(), exact[at], strict=True)]
    assert times[0] == 30
    assert times[1] >= 12
    assert np.all(held >= 0.85 * times[:, None])
    widths = [i.high - i.low for i in found.first.values()]
    assert max(widths) < 0.35


@pytest.mark.promise("campaigns-38")
def test_a_function_without_a_surrogate_has_no_total_indices() -> None:
    x = philox(2).random((3000, 2))
    board = np.sign(np.sin(9.0 * math.pi * x[:, 0]) * np.sin(9.0 * math.pi * x[:, 1]))
    found = of(x, board)
    assert found.total == {}
    assert found.surrogate_q2 < 0.1
    assert "surrogate predicts 0 % of the variance where 80 % are needed" in found.note
    assert max(i.value for i in found.first.values()) < 0.05
    assert of(x, np.sin(3.0 * x[:, 0]) * x[:, 1]).total != {}


def test_what_the_surrogate_leaves_out_is_in_the_intervals() -> None:
    x = philox(3).random((2000, 2))
    step = of(x, (x[:, 0] > 0.3).astype(float))
    assert 0.8 < step.surrogate_q2 < 0.98
    assert step.total["x0"].high == 1.0  # all of it comes from x0
    assert step.total["x1"].high == pytest.approx(1.0 - step.surrogate_q2, abs=0.01)
    noisy = of(x, x[:, 0] + 0.1 * philox(4).normal(size=2000))
    exact = (1.0 / 12.0) / (1.0 / 12.0 + 0.01)
    assert noisy.total["x0"].low <= exact <= noisy.total["x0"].high
    assert_allclose([noisy.first["x0"].value, noisy.total["x0"].value], exact, atol=0.02)


def test_inputs_of_any_distribution() -> None:
    normal = philox(5).normal(50.0, 3.0, (2000, 2))
    found = of(normal, 4.0 * normal[:, 0] - 3.0 * normal[:, 1])
    assert_allclose([i.value for i in found.total.values()], [0.64, 0.36], atol=0.03)
    assert_allclose([i.value for i in found.first.values()], [0.64, 0.36], atol=0.03)
    assert found.surrogate_q2 > 0.999
    decades = 10.0 ** philox(6).uniform(-6.0, 0.0, (2000, 2))
    found = of(decades, 2.0 * np.log(decades[:, 0]) + np.log(decades[:, 1]))
    assert_allclose([i.value for i in found.total.values()], [0.8, 0.2], atol=0.03)
    assert found.surrogate_q2 > 0.999  # a polynomial in the values themselves has 0.9


def test_inputs_with_few_values() -> None:
    x = philox(7).integers(0, 2, (2000, 3)).astype(float)
    found = of(x, x[:, 0] + x[:, 1] * x[:, 2])
    assert_allclose([i.value for i in found.first.values()], [4 / 7, 1 / 7, 1 / 7], atol=0.04)
    assert_allclose([i.value for i in found.total.values()], [4 / 7, 2 / 7, 2 / 7], atol=0.04)
    assert found.surrogate_q2 > 0.999
    three = np.column_stack([philox(8).choice([1.0, 2.0, 50.0], 2000), philox(9).random(2000)])
    assert of(three, np.abs(three[:, 0] - 2.0)).first["x0"].value == pytest.approx(1.0)


def test_rows_without_a_value_are_left_out() -> None:
    x = philox(10).random((600, 3))
    y = ishigami(x)
    holes_x, holes_y = x.copy(), y.copy()
    holes_y[[3, 17]], holes_x[5, 2] = (math.nan, math.inf), math.nan
    kept = np.setdiff1d(np.arange(600), [3, 5, 17])
    assert of(holes_x, holes_y) == of(x[kept], y[kept])
    assert of(holes_x, holes_y).rows == 597
    assert of(holes_x, holes_y) != of(x, y)


@pytest.mark.promise("campaigns-37")
def test_an_input_that_does_not_matter_explains_nothing_in_the_mean() -> None:
    """Levels and slopes of the bins both follow the noise: either bias alone is ten times the standard error here."""
    random, found = np.random.default_rng(3), []
    for _ in range(200):
        x, y = random.uniform(size=500), random.standard_normal(500)
        place, bins = _bins(x)
        across, off = _inside(x, place), (y - np.mean(y)) / np.std(y)
        parts = (np.ones(500), across, across**2, off, across * off, off**2)
        found.append(float(_ratio(np.stack([np.bincount(place, part, bins) for part in parts]))[0]))
    assert abs(np.mean(found)) < 4.0 * np.std(found) / math.sqrt(200.0) < 0.01


def test_what_does_not_vary_explains_nothing() -> None:
    x = philox(11).random((500, 2))
    x[:, 1] = 7.0
    found = of(x, x[:, 0] ** 2)
    assert (found.first["x1"].value, found.first["x1"].high, found.total["x1"].high) == (0.0, 0.0, 0.0)
    assert math.isnan(found.rank_correlation["x1"].value)
    assert found.total["x0"].value == pytest.approx(1.0, abs=1e-6)
    still = of(x, np.full(500, 0.1))
    assert (still.first, still.total, still.rank_correlation) == ({}, {}, {})
    assert still.note == "the output is the same in all rows"
    alone = of(x[:, 1:], x[:, 0])
    assert (alone.total, alone.note) == ({}, "no total indices: no input varies")


@pytest.mark.promise("campaigns-39")
def test_too_few_rows_and_no_inputs() -> None:
    x = philox(12).random((63, 1))
    assert of(x, x[:, 0]).note == "63 good rows are too few to say what matters: 64 are needed"
    assert of(x, x[:, 0]).first == {}
    enough = philox(12).random((64, 1))
    assert of(enough, enough[:, 0]).first["x0"].value > 0.99
    assert sensitivity({}, x[:, 0], "y").note == "no inputs are drawn"


@pytest.mark.promise("campaigns-38")
def test_inputs_that_depend_on_each_other_have_no_total_indices() -> None:
    x = philox(13).normal(size=(1000, 3))
    x[:, 2] = 0.8 * x[:, 1] + 0.6 * x[:, 2]
    found = of(x, x[:, 0] + x[:, 1])
    assert found.total == {}
    assert found.note.startswith("no total indices: x1 and x2 are not independent (rank correlation 0.7")
    assert found.first["x2"].value == pytest.approx(0.5 * 0.64, abs=0.06)  # what it shares with x1
    assert of(x[:, :2], x[:, 0] + x[:, 1]).total != {}


@pytest.mark.promise("campaigns-39")
def test_rank_correlations() -> None:
    x = philox(14).random((400, 2))
    y = np.exp(5.0 * x[:, 0]) + 20.0 * x[:, 1].round(1)
    found = of(x, y).rank_correlation
    for at in range(2):
        exact = stats.spearmanr(x[:, at], y).statistic
        assert found[f"x{at}"].value == pytest.approx(exact, abs=1e-12)
        assert found[f"x{at}"].low < exact < found[f"x{at}"].high
        width = np.arctanh(found[f"x{at}"].high) - np.arctanh(found[f"x{at}"].low)
        sigmas = stats.norm.ppf(0.5 + found[f"x{at}"].confidence / 2)
        assert width == pytest.approx(2 * sigmas * math.sqrt((1 + exact**2 / 2) / 397), rel=1e-9)
    ties = of(x.round(1), y.round(0)).rank_correlation["x0"].value
    assert ties == pytest.approx(stats.spearmanr(x[:, 0].round(1), y.round(0)).statistic, abs=1e-12)
    falling = of(x, -x[:, 0]).rank_correlation["x0"]
    assert falling.value == pytest.approx(-1.0)
    assert falling.high < -0.999
    held = 0
    for seed in range(200):
        pair = philox(15_000 + seed).normal(size=(100, 2))
        found = of(pair, 0.6 * pair[:, 0] + 0.8 * pair[:, 1]).rank_correlation
        held += found["x0"].low <= 6.0 / math.pi * math.asin(0.3) <= found["x0"].high
    assert 180 <= held < 200


@pytest.mark.promise("campaigns-39")
def test_it_is_the_same_each_time_and_looks_at_no_more_rows_than_it_says() -> None:
    x = philox(16).random((MOST_ROWS + 500, 2))
    y = x[:, 0] + x[:, 1] ** 2
    whole = of(x, y)
    assert whole.rows == MOST_ROWS
    assert whole == of(x[:MOST_ROWS], y[:MOST_ROWS])
    assert whole != of(x[500:], y[500:])


def three(found) -> list[float]:
    return [found.value, found.low, found.high]


def test_indices_of_inputs_of_unlike_sizes_of_which_one_is_held_and_two_rows_lost() -> None:
    x = philox(31).random((120, 3))
    inputs = {"a": 2.0 + x[:, 0], "b": np.floor(4.0 * x[:, 1]), "c": 1e-6 * x[:, 2] ** 2, "held": np.full(120, 7.0)}
    y = 3.0 * inputs["a"] ** 2 - inputs["b"] + 2e6 * inputs["a"] * inputs["c"] + 0.75 * philox(32).normal(size=120)
    y[[5, 17]] = math.nan, math.inf
    found = sensitivity(inputs, y, "margin", 0.8)
    assert (found.output, found.rows, found.note) == ("margin", 118, "")
    first = {
        "a": [0.8464527, 0.8175376, 0.8753679],
        "b": [0.01883476, 0.0, 0.06412448],
        "c": [0.2025076, 0.09525451, 0.3097607],
        "held": [0.0, 0.0, 0.0],
    }
    total = {
        "a": [0.8263441, 0.8000378, 0.8838477],
        "b": [0.05952912, 0.04426343, 0.1059921],
        "c": [0.09253351, 0.0738738, 0.1423905],
        "held": [0.0, 0.0, 0.0],
    }
    ranks = {
        "a": [0.9216198, 0.897075, 0.9404949],
        "b": [-0.08551934, -0.2026096, 0.03398177],
        "c": [0.3389064, 0.2259975, 0.4428298],
        "held": [math.nan, math.nan, math.nan],
    }
    for wanted, told in ((first, found.first), (total, found.total), (ranks, found.rank_correlation)):
        assert list(told) == list(inputs)
        for key, numbers in wanted.items():
            assert three(told[key]) == pytest.approx(numbers, rel=1e-5, abs=1e-9, nan_ok=True)
            assert told[key].confidence == 0.8
    assert found.surrogate_q2 == pytest.approx(0.9688027, rel=1e-6)


@pytest.mark.parametrize(
    ("inputs", "y", "note", "rows"),
    [
        ({}, np.arange(100.0), "no inputs are drawn", 100),
        ({"a": np.arange(63.0)}, np.arange(63.0), "63 good rows are too few to say what matters: 64 are needed", 63),
        ({"a": np.arange(70.0)}, np.full(70, -2.5), "the output is the same in all rows", 70),
        (
            {"a": np.append(np.arange(63.0), [math.nan, math.inf])},
            *(np.arange(65.0), "63 good rows are too few to say what matters: 64 are needed", 63),
        ),
    ],
)
def test_of_rows_that_say_nothing_no_index_is_told(inputs, y, note, rows) -> None:
    found = sensitivity(inputs, y, "margin")
    assert (found.output, found.note, found.rows) == ("margin", note, rows)
    assert found.first == found.total == found.rank_correlation == {} and math.isnan(found.surrogate_q2)


def test_without_totals_it_is_said_which_inputs_go_together_or_that_none_varies() -> None:
    x = philox(33).random((200, 2))
    inputs = {"held": np.full(200, 3.0), "a": x[:, 0], "b": x[:, 1], "c": x[:, 1] - 0.25 * x[:, 0]}
    found = sensitivity(inputs, x[:, 0] + x[:, 1], "y")
    assert found.total == {} and math.isnan(found.surrogate_q2)
    assert found.note == "no total indices: b and c are not independent (rank correlation 0.97)"
    still = sensitivity({"held": np.full(200, 3.0)}, x[:, 0], "y")
    assert (still.note, three(still.first["held"])) == ("no total indices: no input varies", [0.0, 0.0, 0.0])
    assert np.isnan(three(still.rank_correlation["held"])).all()


@pytest.mark.parametrize(
    ("most", "count", "terms", "ends"),
    [
        ([2, 1], 9, [(0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (2, 1)], [3, 5, 6]),
        ([2, 1], 5, [(0, 0), (1, 0), (0, 1), (2, 0), (1, 1)], [3, 5]),
        ([1, 1, 1], 6, [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)], [4]),
        ([3], 2, [(0,), (1,)], [2]),
        ([3, 3], 2, [(0, 0)], [1]),
    ],
)
def test_terms_come_by_their_degree_as_far_as_whole_degrees_fit(most, count, terms, ends) -> None:
    found, upto = _terms(most, count)
    assert ([tuple(each) for each in found.tolist()], upto) == (terms, ends)
    assert found.shape == (len(terms), len(most))


def test_means_over_independent_inputs_are_products_of_those_of_each() -> None:
    marginals = [np.array([[1.0, 0.5], [0.5, 2.0]]), np.array([[3.0, -1.0], [-1.0, 4.0]]), np.array([[5.0]])]
    degrees = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]])
    whole, others, averaged = _product_measure(marginals, degrees)
    a, b = (np.array([[m[i, j] for j in d] for i in d]) for m, d in zip(marginals, degrees.T[:2], strict=False))
    assert_allclose(whole, a * b * 5.0)
    assert_allclose(others, [b * 5.0, a * 5.0, a * b])
    assert_allclose(averaged[1], [1.0, 0.5, 1.0, 0.5])
    assert_allclose(averaged[2], [3.0, 3.0, -1.0, -1.0])
    assert_allclose(averaged[0], averaged[1] * averaged[2] * 5.0)


@pytest.mark.parametrize(("q2", "told"), [(0.797, "79.7 %"), (0.79999, "79.9 %"), (0.5, "50 %"), (-math.inf, "0 %")])
def test_a_surrogate_that_just_misses_is_not_told_to_reach_what_is_needed(monkeypatch, q2, told):
    monkeypatch.setattr("microrad.campaign.statistics.sensitivity._fit", lambda polynomials, y: SimpleNamespace(q2=q2))
    x = philox(34).random(100)
    assert sensitivity({"a": x}, x, "margin").note == (
        f"no total indices: the polynomial surrogate predicts {told} of the variance where 80 % are needed"
    )
