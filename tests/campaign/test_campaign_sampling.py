"""The random numbers of a campaign: their distributions, how they fill the cube, and that any row can be had alone."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from scipy import stats

from campaign_files import HEAD, IDENTIFIED, LOOP, POWER, loaded, written
from microrad.campaign.definition import distributions
from microrad.campaign.definition.distributions import LogUniform, Normal, OneOf, Uniform
from microrad.campaign.definition.reader import block_rows
from microrad.campaign.file import load_campaign
from microrad.campaign.rows import sampling
from microrad.core import lti
from microrad.mirror import spread as mirror_spread

METHODS = ("random", "latin-hypercube", "sobol")
WIDE = (
    '[inputs."communication.transmit_power".drawn_as]\ndistribution = "normal"\nmean = "4.8 W"\ndeviation = "0.25 W"\n'
)


def campaign(folder, method="sobol", runs=4096, inputs=POWER, seed=1):
    head = HEAD.replace("sobol", method).replace("256", str(runs)).replace("seed = 1", f"seed = {seed}")
    return loaded(folder, head + inputs)


# ------------------------------------------------------------------------------------------------------- distributions
DRAWN = {
    "normal": (Normal(5.0, 0.2), stats.norm(5.0, 0.2)),
    "uniform": (Uniform(-1.0, 3.0), stats.uniform(-1.0, 4.0)),
    "log-uniform": (LogUniform(1e-7, 1e-5), stats.loguniform(1e-7, 1e-5)),
}


@pytest.mark.promise("campaigns-7")
@pytest.mark.parametrize("name", DRAWN)
@pytest.mark.parametrize("method", METHODS)
def test_marginals_are_those_of_scipy(name, method):
    ours, peer = DRAWN[name]
    for seed in (1, 2, 3):
        drawn = ours.at(sampling.uniform(method, seed, 256, 3, 0, 4096)[:, 1])
        assert stats.kstest(drawn, peer.cdf).pvalue > 1e-3
        assert stats.kstest(drawn, stats.norm(peer.mean(), peer.std()).cdf).pvalue < 1e-3 or name == "normal"
    value = peer.ppf([0.01, 0.3, 0.99])
    np.testing.assert_allclose(ours.log_density(value), peer.logpdf(value), rtol=1e-12)
    np.testing.assert_allclose(ours.at(np.array([0.01, 0.3, 0.99])), value, rtol=1e-12)


def test_a_range_has_no_density_outside():
    assert Uniform(1.0, 2.0).log_density(np.array([0.99, 2.01])).tolist() == [-math.inf] * 2
    assert LogUniform(1.0, 2.0).log_density(np.array([-1.0, 0.99, 2.01])).tolist() == [-math.inf] * 3


@pytest.mark.promise("campaigns-7")
@pytest.mark.parametrize("method", METHODS)
def test_values_of_a_table_come_as_often_as_their_weights(method):
    table = OneOf((0.05, 0.06, 0.08), (0.5, 0.125, 0.375), ("5 cm", "6 cm", "8 cm"), False)
    drawn = table.at(sampling.uniform(method, 3, 256, 1, 0, 8192)[:, 0])
    counts = [int(np.sum(drawn == value)) for value in table.values]
    assert sum(counts) == 8192
    assert stats.chisquare(counts, 8192 * np.array(table.probabilities)).pvalue > 1e-3
    np.testing.assert_allclose(np.exp(table.log_density(np.array([0.06, 0.07]))), [0.125, 0.0])


# ------------------------------------------------------------------------------------------------------------ any row
@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("dimensions", [1, 4, 5])
def test_a_row_by_itself_is_the_same_as_in_any_range(method, dimensions):
    whole = sampling.uniform(method, 7, 64, dimensions, 0, 300)
    assert whole.shape == (300, dimensions)
    parts = [
        sampling.uniform(method, 7, 64, dimensions, first, count) for first, count in ((0, 17), (17, 130), (147, 153))
    ]
    assert np.array_equal(np.concatenate(parts), whole)
    for row in (0, 63, 64, 65, 299):
        assert np.array_equal(sampling.uniform(method, 7, 64, dimensions, row, 1)[0], whole[row])
    assert np.unique(whole).size == whole.size
    assert not np.isin(sampling.uniform(method, 8, 64, dimensions, 0, 300), whole).any()  # another seed
    assert sampling.uniform(method, 7, 64, dimensions, 5, 0).shape == (0, dimensions)
    assert sampling.uniform(method, 7, 64, 0, 5, 3).shape == (3, 0)


@pytest.mark.promise("campaigns-20", "campaigns-60")
@pytest.mark.parametrize("seed", [0, 1, 2**64 - 1])
def test_rows_are_independent_of_each_other_and_of_neighbouring_seeds(seed):
    drawn = sampling.uniform("random", seed, 64, 3, 10**9, 4000)
    other = sampling.uniform("random", seed - 1 if seed else 1, 64, 3, 10**9, 4000)
    pairs = [(drawn[:-1], drawn[1:]), (drawn, other), (drawn[:, :2], drawn[:, 1:])]
    for a, b in pairs:
        assert abs(np.corrcoef(a.ravel(), b.ravel())[0, 1]) < 4.0 / math.sqrt(a.size)


@pytest.mark.parametrize("method", METHODS)
def test_all_points_lie_inside_the_open_cube(method):
    drawn = sampling.uniform(method, 5, 4096, 2, 0, 1 << 16)
    assert 0.0 < drawn.min() < 1e-3
    assert 1.0 - 1e-3 < drawn.max() < 1.0
    assert np.all(np.isfinite(distributions.standard_normal(drawn)))


def test_words_at_the_ends_of_their_range_stay_inside():
    ends = np.array([0, 2**64 - 1], dtype=np.uint64)
    low, high = sampling._open_unit(ends)
    assert 0.0 < low < 1e-15
    assert 1.0 - 1e-15 < high < 1.0


# ---------------------------------------------------------------------------------------------------------- even cubes
@pytest.mark.promise("campaigns-5")
@pytest.mark.parametrize(("runs", "block"), [(1, 16), (100, 16), (128, 16), (256, 32), (2048, 256), (10**6, 4096)])
def test_a_block_is_an_eighth_of_the_runs_within_bounds(runs, block):
    assert block_rows(runs) == block


def strata(points):
    """Points in each of as many equal intervals as there are points, by dimension."""
    size = len(points)
    return [np.bincount((column * size).astype(int), minlength=size) for column in points.T]


@pytest.mark.promise("campaigns-5", "campaigns-20")
@pytest.mark.parametrize("method", METHODS)
def test_each_block_has_one_point_in_each_stratum_of_each_input(method):
    for number in range(3):
        counts = strata(sampling.uniform(method, 11, 128, 4, 128 * number, 128))
        even = all(np.all(count == 1) for count in counts)
        assert even == (method != "random")
    across = strata(sampling.uniform(method, 11, 128, 4, 64, 128))
    assert not all(np.all(count == 1) for count in across)  # two halves of two blocks


@pytest.mark.promise("campaigns-21")
def test_blocks_are_independent_replicates():
    """Their means spread as those of independent sets: no correlation from one block to the next."""
    for method in ("latin-hypercube", "sobol"):
        points = sampling.uniform(method, 2, 16, 2, 0, 16 * 800).reshape(800, 16, 2)
        means = (points[:, :, 0] * points[:, :, 1]).mean(axis=1)
        assert abs(np.corrcoef(means[:-1], means[1:])[0, 1]) < 4.0 / math.sqrt(800)
        assert abs(np.mean(means) - 0.25) < 4.0 * np.std(means) / math.sqrt(800)


@pytest.mark.promise("campaigns-20")
def test_sobol_knows_a_smooth_mean_better_than_a_hypercube_and_that_better_than_random():
    """Spread of the mean of a product of five inputs over 40 seeds, 1024 rows in blocks of 128."""
    spread = {}
    for method in METHODS:
        means = [np.prod(1.0 + sampling.uniform(method, seed, 128, 5, 0, 1024), axis=1).mean() for seed in range(40)]
        assert abs(np.mean(means) - 1.5**5) < 4.0 * np.std(means) / math.sqrt(40)
        spread[method] = np.std(means)
    assert spread["sobol"] < 0.5 * spread["latin-hypercube"] < 0.25 * spread["random"]


# ------------------------------------------------------------------------------------------------------------ campaigns
@pytest.mark.promise("campaigns-5", "campaigns-60")
def test_columns_come_in_the_order_of_the_file_and_are_the_same_for_all_cells(tmp_path):
    other = '[inputs."terminals.leo_aperture"]\ndistribution = "uniform"\nlow = "4 cm"\nhigh = "6 cm"\n'
    c = campaign(tmp_path, inputs=POWER + other + '[grid]\n"terminals.geo_aperture" = ["15 cm", "20 cm"]\n')
    columns, weight = sampling.rows(c, 0, 100, 50)
    assert list(columns) == ["communication.transmit_power", "terminals.leo_aperture"]
    assert [column.shape for column in columns.values()] == [(50,)] * 2
    assert np.all(weight == 1.0)
    second, _ = sampling.rows(c, 1, 100, 50)
    assert all(np.array_equal(columns[key], second[key]) for key in columns)
    assert abs(np.corrcoef(*columns.values())[0, 1]) < 0.5
    assert 0.04 <= columns["terminals.leo_aperture"].min() < columns["terminals.leo_aperture"].max() <= 0.06


def test_a_campaign_without_inputs_has_rows_without_columns(tmp_path):
    columns, weight = sampling.rows(campaign(tmp_path, inputs=LOOP), 0, 3, 7)
    assert columns == {}
    assert weight.tolist() == [1.0] * 7


@pytest.mark.parametrize("method", METHODS)
def test_columns_and_weights_of_a_row_by_itself_are_those_of_the_range(tmp_path, method):
    low = '[inputs."terminals.leo_aperture"]\ndistribution = "log-uniform"\nlow = "4 cm"\nhigh = "6 cm"\n'
    c = campaign(tmp_path, method, 256, f'{POWER}{WIDE}{low}{IDENTIFIED}[set]\nmirror = "mirror.toml"\n')
    columns, weight = sampling.rows(c, 0, 0, 100)
    assert len(columns) == 5
    for first, count in ((0, 1), (31, 2), (57, 43)):
        some, some_weight = sampling.rows(c, 0, first, count)
        assert np.array_equal(some_weight, weight[first : first + count])
        assert all(np.array_equal(some[key], columns[key][first : first + count]) for key in columns)
    assert not np.array_equal(weight[:10], weight[10:20])


@pytest.mark.promise("campaigns-22")
@pytest.mark.parametrize("method", METHODS)
def test_weights_average_to_one_and_bring_the_mean_back(tmp_path, method):
    c = campaign(tmp_path, method, 8192, POWER + WIDE)
    assert "drawn as normal, mean 4.8 W, deviation 250 mW and weighted" in c.inputs[0].distribution
    columns, weight = sampling.rows(c, 0, 0, 8192)
    power = columns["communication.transmit_power"]
    error = np.std(weight) / math.sqrt(8192)
    assert 0.0 < error < 0.02
    assert abs(weight.mean() - 1.0) < 4.0 * error
    assert abs(np.mean(power) - 4.8) < 0.02  # drawn as
    spread = np.std(weight * (power - 5.0)) / math.sqrt(8192)
    assert abs(np.mean(weight * (power - 5.0))) < 4.0 * spread
    far = weight * (power < 4.4)  # 3 sigma of what is meant, 1.6 of what is drawn
    assert np.mean(far) == pytest.approx(stats.norm.cdf(-3.0), rel=0.15)
    expected = stats.norm.pdf(power, 5.0, 0.2) / stats.norm.pdf(power, 4.8, 0.25)
    np.testing.assert_allclose(weight, expected, rtol=1e-9)


COVERED = [
    (Normal(0.0, 1.0), Normal(3.0, 1.0), ""),
    (Normal(0.0, 1.0), Normal(0.0, 0.7), "is too narrow"),
    (Normal(0.0, 1.0), Uniform(-9.0, 9.0), "never draws far out"),
    (Uniform(1.0, 2.0), Normal(0.0, 0.1), ""),
    (Uniform(1.0, 2.0), LogUniform(1.0, 2.0), ""),
    (Uniform(1.0, 2.0), LogUniform(1.1, 2.0), "does not reach every value"),
    (LogUniform(1.0, 2.0), Uniform(0.0, 1.9), "does not reach every value"),
    (OneOf((1.0, 2.0), (0.5, 0.5), (1, 2), False), OneOf((2.0, 1.0), (0.9, 0.1), (2, 1), False), ""),
    (OneOf((1.0, 2.0), (0.5, 0.5), (1, 2), False), OneOf((1.0, 3.0), (0.9, 0.1), (1, 3), False), "every value"),
    (OneOf((1.0, 2.0), (0.5, 0.5), ("a", "b"), True), OneOf((1.0, 2.0), (0.9, 0.1), ("b", "a"), True), "every value"),
    (OneOf((1.0, 2.0), (0.5, 0.5), ("a", "b"), True), OneOf((1.0, 2.0), (0.9, 0.1), ("a", "b"), True), ""),
    (Uniform(1.0, 2.0), OneOf((1.0, 2.0), (0.9, 0.1), (1, 2), False), "every value"),
]


@pytest.mark.parametrize("case", range(len(COVERED)))
def test_only_what_reaches_every_value_can_stand_for_another_distribution(case):
    wanted, drawn, reason = COVERED[case]
    found = distributions.uncovered(wanted, drawn)
    assert (reason in found) and bool(found) == bool(reason)


# --------------------------------------------------------------------------------------------------- identified mirrors
@pytest.mark.promise("readme-12")
@pytest.mark.promise("campaigns-13")
def test_identified_mirrors_have_the_covariance_of_their_file(tmp_path):
    c = campaign(tmp_path, "sobol", 4096, f'{IDENTIFIED}[set]\nmirror = "mirror.toml"\n')
    columns, weight = sampling.rows(c, 0, 0, 4096)
    assert np.all(weight == 1.0)
    nominal = c.mission.mission.mirror
    values = [nominal.bouc_wen.d1_rad_v, nominal.bouc_wen.alpha_1_v, nominal.linear.poles_hz[0]]
    factors = np.array([column / value for column, value in zip(columns.values(), values, strict=True)])
    wanted = mirror_spread.relative_covariance(nominal)
    assert np.linalg.norm(np.cov(factors) - wanted) < 0.02 * np.linalg.norm(wanted)
    assert abs(wanted[0, 1]) > 0.1 * math.sqrt(wanted[0, 0] * wanted[1, 1])  # and it is not diagonal
    np.testing.assert_allclose(factors.mean(axis=1), 1.0, atol=1e-4)


def test_parameters_are_the_covariance_root_times_the_normals_and_those_of_draws(tmp_path):
    c = campaign(tmp_path, inputs=f'{IDENTIFIED}[set]\nmirror = "mirror.toml"\n')
    table = c.mission.mission.mirror
    normals = np.array([[0.0, 0.0, 0.0], [1.0, -1.0, 0.5]])
    found = mirror_spread.parameters(table, normals, lambda row: iter(()))
    root = lti.covariance_root(mirror_spread.relative_covariance(table))
    nominal = np.array([table.bouc_wen.d1_rad_v, table.bouc_wen.alpha_1_v, table.linear.poles_hz[0]])
    assert np.array_equal(found, nominal * (1.0 + normals @ root.T))
    assert mirror_spread.parameter_units(table) == {
        "bouc_wen.d1": "rad/V",
        "bouc_wen.alpha": "1/V",
        "linear.poles.1": "Hz",
    }
    stream = np.random.Generator(np.random.Philox(np.random.SeedSequence(5, spawn_key=(0,))))
    drawn = mirror_spread.draws(table, 1, 5)[0]
    same = mirror_spread.parameters(table, stream.standard_normal((1, 3)), lambda row: iter(()))
    assert drawn.bouc_wen.d1_rad_v == same[0, 0]


def test_a_draw_that_is_no_mirror_is_drawn_again_from_the_rows_own_stream(tmp_path):
    path = written(tmp_path, HEAD + f'{IDENTIFIED}[set]\nmirror = "mirror.toml"\n')
    text = (tmp_path / "mirror.toml").read_text(encoding="utf-8")
    wide = text.replace("standard_errors = [0.02, 0.03, 0.01]", "standard_errors = [0.9, 0.03, 0.01]")
    (tmp_path / "mirror.toml").write_text(wide, encoding="utf-8")
    c = load_campaign(path)
    whole, _ = sampling.rows(c, 0, 0, 256)
    gain = whole["mirror.bouc_wen.d1"]
    normals = distributions.standard_normal(sampling.uniform("sobol", 1, c.block, 3, 0, 256))
    root = lti.covariance_root(mirror_spread.relative_covariance(c.mission.mission.mirror))
    first_tries = 1.0 + normals @ root.T
    again = first_tries[:, 0] <= 0.0
    assert 10 < np.sum(again) < 80  # about one in eight changes its sign
    assert np.all(gain > 0.0)
    np.testing.assert_allclose(gain[~again], 0.089e-3 * first_tries[~again, 0], rtol=1e-14)
    assert np.unique(gain[again]).size == np.sum(again)
    for row in np.flatnonzero(again)[:5]:
        alone, _ = sampling.rows(c, 0, int(row), 1)
        assert alone["mirror.bouc_wen.d1"][0] == gain[row]


def test_an_uncertainty_that_leaves_no_mirror_says_so(tmp_path):
    c = campaign(tmp_path, inputs=f'{IDENTIFIED}[set]\nmirror = "mirror.toml"\n')
    bad = iter([np.array([-1e3, 0.0, 0.0])] * mirror_spread.TRIES)
    with pytest.raises(ValueError, match=r"leaves no mirror: none of 10000 draws is one.*10000 times because"):
        mirror_spread.parameters(c.mission.mission.mirror, np.array([[-1e3, 0.0, 0.0]]), lambda row: bad)


@pytest.mark.parametrize(
    ("method", "first", "points"),
    [
        (
            "random",
            6,
            [
                [0.4726447, 0.2040295, 0.1536683, 0.2062889, 0.2905996],
                [0.08024089, 0.623855, 0.4871266, 0.5605246, 0.348085],
            ],
        ),
        ("latin-hypercube", 15, [[0.07754339, 0.4376638, 0.06679801], [0.6728366, 0.910744, 0.08288494]]),
        ("sobol", 15, [[0.4349522, 0.1619034, 0.175695], [0.9619341, 0.01317738, 0.633286]]),
    ],
)
def test_points_across_the_end_of_a_block_are_those_of_their_seed_and_number(method, first, points):
    size = len(points[0])
    np.testing.assert_allclose(sampling.uniform(method, 9, 16, size, first, 2), points, rtol=1e-6)
    whole = sampling.uniform(method, 9, 16, size, 0, 20)
    np.testing.assert_allclose(whole[first : first + 2], points, rtol=1e-6)
    assert sampling.uniform(method, 9, 16, 0, first, 2).shape == (2, 0)
    assert sampling.uniform(method, 9, 16, 4, first, 0).shape == (0, 4)


@pytest.mark.parametrize(
    ("of", "share", "value", "density"),
    [
        (Normal(-2.5, 0.5), 0.1, -2.5 - 0.5 * 1.2815515655446004, -0.5 * 1.2815515655446004**2 - 0.2257913526447274),
        (Uniform(-2.5, 1.5), 0.1, -2.1, -math.log(4.0)),
        (LogUniform(2.0, 50.0), 0.1, 2.0 * 25.0**0.1, -math.log(2.0 * 25.0**0.1 * math.log(25.0))),
        (OneOf((7.0, -3.0, 2.0), (0.0625, 0.5, 0.4375), ("x",) * 3, False), 0.1, -3.0, math.log(0.5)),
        (OneOf((7.0, -3.0, 2.0), (0.0625, 0.5, 0.4375), ("x",) * 3, False), 0.5625, 2.0, math.log(0.4375)),
    ],
)
def test_a_share_of_the_draws_stays_below_its_value_which_has_its_density(of, share, value, density):
    found = of.at(np.array([share, 0.5]))
    assert float(found[0]) == pytest.approx(value, rel=1e-9)
    assert float(of.log_density(found)[0]) == pytest.approx(density, rel=1e-9)


@pytest.mark.parametrize(
    ("of", "unit", "words"),
    [
        (Normal(622.08e6, 2.5e6), "bit/s", "normal, mean 622.1 Mbit/s, deviation 2.5 Mbit/s"),
        (Normal(0.123456789, 0.0625), "", "normal, mean 0.123457, deviation 0.0625"),
        (Uniform(-2.5e-6, 1.5e-5), "rad", "uniform, -2.5 µrad to 15 µrad"),
        (LogUniform(0.05, 1.25), "m", "log-uniform, 50 mm to 1.25 m"),
        (OneOf((0.05, 1.25), (0.25, 0.75), ("5 cm", "1.25 m"), False), "m", "one of 50 mm, 1.25 m, weights 0.25, 0.75"),
        (
            OneOf((1.0, 2.0, 3.0), (0.5, 0.125, 0.375), ("a", "b", "c"), True),
            "",
            "one of 1 = a, 2 = b, 3 = c, weights 0.5, 0.125, 0.375",
        ),
        (OneOf((4.0, 8.0), (0.5, 0.5), (4, 8), False), "", "one of 4, 8"),
    ],
)
def test_a_distribution_in_words_has_its_numbers_in_their_unit(of, unit, words):
    assert of.words(unit) == words


@pytest.mark.parametrize(("seed", "number"), [(3, 0), (3, 1), (2**40, 7)])
def test_points_of_sobol_are_in_the_middle_of_the_cells_of_their_grid_and_stay_as_they_are(seed, number):
    points = sampling._block("sobol", seed, 32, 3, number)
    places = points * 2.0**31
    assert np.all(places % 2.0 == 1.0) and np.all((points > 0.0) & (points < 1.0))
    with pytest.raises(ValueError, match="read-only"):
        points[0, 0] = 0.5
    np.testing.assert_array_equal(np.sort(np.floor(32.0 * points), axis=0), np.tile(np.arange(32.0)[:, None], 3))


def test_points_of_a_hypercube_at_the_ends_are_drawn_in_by_a_bit(monkeypatch):
    given = np.array([[0.0, 1.0], [0.25, 0.5], [2.0**-60, 1.0 - 2.0**-54]])
    monkeypatch.setattr(
        "scipy.stats.qmc.LatinHypercube", lambda *of, **more: SimpleNamespace(random=lambda count: given)
    )
    found = sampling._block("latin-hypercube", 2**50 + 11, 4, 2, 5)
    assert found.tolist() == [[2.0**-54, 1.0 - 2.0**-53], [0.25, 0.5], [2.0**-54, 1.0 - 2.0**-53]]


@pytest.mark.parametrize(("dimensions", "count"), [(0, 5), (3, 0), (0, 0)])
@pytest.mark.parametrize("method", METHODS)
def test_no_inputs_and_no_rows_have_no_points_in_their_shape(method, dimensions, count):
    assert sampling.uniform(method, 1, 16, dimensions, 7, count).shape == (count, dimensions)


def test_words_of_64_bits_lie_in_the_middle_of_steps_of_52_bits():
    raw = np.array([0, 2**12 - 1, 2**12, 2**63, 2**64 - 1], dtype=np.uint64)
    assert sampling._open_unit(raw).tolist() == [2.0**-53, 2.0**-53, 3.0 * 2.0**-53, 0.5 + 2.0**-53, 1.0 - 2.0**-53]


def test_random_rows_of_five_numbers_have_two_blocks_of_words_each():
    whole = sampling.uniform("random", 9, 16, 5, 0, 6)
    raw = np.random.Philox(key=9 | 1 << 64, counter=0).random_raw(48).reshape(6, 8)[:, :5]
    np.testing.assert_array_equal(whole, ((raw >> np.uint64(12)) + 0.5) * 2.0**-52)
    np.testing.assert_array_equal(sampling.uniform("random", 9, 16, 5, 2, 3), whole[2:5])
    np.testing.assert_array_equal(
        sampling.uniform("random", 9, 16, 4, 0, 2)[1], sampling.uniform("random", 9, 16, 4, 1, 1)[0]
    )
