"""The uncertainty of a mirror file: read and refused, drawn from, and written by an identification."""

import math
import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.stats import truncnorm

import truths
from microrad.core.lti import frequency_response
from microrad.lab.identify import FORMS, Units, fit_joint, identify, mirror_file_text
from microrad.lab.identify.hysteresis.bouc_wen import PARAMETERS
from microrad.lab.identify.hysteresis.joint import JointFit
from microrad.lab.identify.hysteresis.plant_fit import PlantFit
from microrad.lab.identify.hysteresis.prandtl_ishlinskii import threshold_grid
from microrad.lab.identify.hysteresis.structures import LinearPoles, Roots, one_axis
from microrad.lab.identify.records import lead, memory
from microrad.mirror import spread as mirror_spread
from microrad.mirror.hysteresis import NO_CREEP, BoucWen, Creep, PrandtlIshlinskii, slow_gain
from microrad.mirror.model import hysteresis_model, linear_part
from microrad.mission.file import MissionError, load_mirror
from microrad.mission.tables.mirror import place
from truths import philox

MIRROR = """
name = "m"
travel = "3 mrad"
composition = "cascade"
rate_limit = "500 V/s"
bias = "5 V"
drive_min = "0 V"
drive_max = "10 V"
{model}
[creep]
time_constants = ["0.1 s", "1 s"]
weights = ["2 urad/V", "1 urad/V"]
[linear]
poles = ["150 Hz", "400 Hz"]
pole_dampings = [0.35, 1.0]
normalise_at = "3 Hz"
excited_from = "1 Hz"
excited_to = "500 Hz"
"""
PLAYS = MIRROR.format(
    model='[prandtl_ishlinskii]\nthresholds = ["0 V", "1 V", "2 V"]\nweights = ["60 urad/V", "0 urad/V", "20 urad/V"]'
)
BOUC_WEN = MIRROR.format(
    model='[bouc_wen]\nd1 = "80 urad/V"\nd2 = "0 s/V"\nepsilon = "-30 urad/V"\ndelta = "4e-3 s/V"\n'
    'alpha = "1.5 1/V"\nbeta = "0.4 1/V"'
)


@pytest.fixture
def read(tmp_path):
    def mirror_of(text):
        path = tmp_path / "mirror.toml"
        path.write_text(text, encoding="utf-8")
        return load_mirror(path).mirror

    return mirror_of


def table(parameters, errors, correlation=None):
    lines = ["[uncertainty]", f"parameters = {parameters}".replace("'", '"'), f"standard_errors = {errors}"]
    return "\n".join([*lines, *([] if correlation is None else [f"correlation = {correlation}"])])


def within(sample, expected, sigmas=4.5):
    """Whether a sample covariance lies in the interval of its Wishart distribution, element by element."""
    size = np.diag(expected)
    spread = np.sqrt((np.outer(size, size) + expected**2) / sample[1])
    return np.all(np.abs(sample[0] - expected) < sigmas * spread)


def gains(mirrors):
    return np.array([slow_gain(hysteresis_model(m, m.rate_limit_v_s, m.bias_v)) for m in mirrors])


# ------------------------------------------------------------------------------------------------------- in the file
@pytest.mark.promise("mirror-file-12", "mirror-file-24")
@pytest.mark.promise("identify-25")
def test_a_mirror_without_uncertainty_stays_valid_and_cannot_be_drawn(read):
    mirror = read(PLAYS)
    assert mirror.uncertainty is None
    for ask in (lambda: mirror_spread.draws(mirror, 1, 0), lambda: mirror_spread.relative_spread(mirror)):
        with pytest.raises(ValueError, match=r'"m" has no table uncertainty.*microrad identify'):
            ask()


@pytest.mark.promise("mirror-file-24")
@pytest.mark.promise("identify-25")
@pytest.mark.promise("mirror-file-60")
def test_the_uncertainty_is_read_with_its_lower_triangle(read):
    names = ["bouc_wen.epsilon", "linear.poles.2", "creep.weights"]
    given = read(BOUC_WEN + table(names, [0.1, 0.02, 1], [0.5, -0.25, 0.125])).uncertainty
    assert given.parameters == tuple(names)
    assert given.standard_errors == (0.1, 0.02, 1.0)
    assert given.correlation_rows == [[1, 0.5, -0.25], [0.5, 1, 0.125], [-0.25, 0.125, 1]]
    for empty in (None, []):
        assert read(BOUC_WEN + table(names, [0.1, 0.02, 1], empty)).uncertainty.correlation_rows == np.eye(3).tolist()


TWO = ["bouc_wen.d1", "bouc_wen.alpha"]
THREE = [*TWO, "bouc_wen.beta"]


@pytest.mark.promise("mirror-file-24")
@pytest.mark.parametrize(
    ("given", "words"),
    [
        (table(["prandtl_ishlinskii.weights"], [0.1]), "which is in no table of this mirror.*linear, bouc_wen, creep"),
        (table(["bouc_wen.d3"], [0.1]), "no parameter of this mirror's bouc_wen.*one of d1, d2, epsilon"),
        (table(["bouc_wen"], [0.1]), "no parameter of this mirror's bouc_wen"),
        (table(["linear.normalise_at"], [0.1]), "no parameter of this mirror's linear.*one of poles, pole_dampings"),
        (table(["linear.zeros.1"], [0.1]), "no parameter of this mirror's linear"),
        (table(["linear.poles.3"], [0.1]), "names no item of a list of 2.*a number from 1 to 2"),
        (table(["linear.poles.0"], [0.1]), "names no item of a list of 2"),
        (table(["linear.poles.x"], [0.1]), "names no item of a list of 2"),
        (table(["linear.poles.\u0661"], [0.1]), "names no item of a list of 2"),
        (table(["bouc_wen.d1.1"], [0.1]), "counts the items of a single value"),
        (table(["bouc_wen.d2"], [0.1]), "is 0 in this mirror, and nothing is relative to 0"),
        (table(["linear.pole_dampings.2"], [0.1]), "damping of a real root, 1 by definition"),
        (table(["linear.pole_dampings"], [0.1]), "damping of a real root, 1 by definition"),
        (table(["bouc_wen.d1", "bouc_wen.d1"], [0.1, 0.1]), "stands twice, or beside its whole list"),
        (table(["creep.weights", "creep.weights.2"], [0.1, 0.1]), "stands twice, or beside its whole list"),
        (table(["creep.weights.2", "creep.weights"], [0.1, 0.1]), "stands twice, or beside its whole list"),
        (table(TWO, [0.1]), "has 1 item where parameters has 2.*one standard error for each"),
        (table(TWO, [0.1, 1.01]), "item 2: 1.01 is above 1"),
        (table(TWO, [0.1, -0.1]), "item 2: -0.1 is below 0"),
        (table(THREE, [0.1] * 3, [0.5]), "has 1 item where 3 parameters have 3 pairs"),
        (table(TWO, [0.1, 0.1], [1.5]), "item 1: 1.5 is above 1"),
        (table(THREE, [0.1] * 3, [0.9, 0.9, -0.9]), "not positive semidefinite: its smallest eigenvalue is -0.8"),
        (table([1], [0.1]), "is not a list of keys in quotes"),
        (table([], []), "is not a list of keys in quotes"),
        (table('"bouc_wen.d1"', [0.1]), "is not a list of keys in quotes"),
        (table(["bouc_wen.d1"] * 1001, [0.1]), "is a list of 1001 items"),
        ("[uncertainty]\nstandard_errors = [0.1]", r"is missing.*parameters = \[.bouc_wen.d1.*linear.poles.1"),
    ],
)
@pytest.mark.promise("mirror-file-60")
def test_refused(read, given, words):
    with pytest.raises(MissionError) as caught:
        read(BOUC_WEN + given)
    assert re.search(words, str(caught.value), re.DOTALL)
    assert "mirror.uncertainty" in str(caught.value)
    assert len(caught.value.faults) <= 2  # an empty list also lacks its standard errors


def test_a_weight_at_its_bound_has_no_relative_error_but_its_list_may_scale(read):
    with pytest.raises(MissionError, match="is 0 in this mirror"):
        read(PLAYS + table(["prandtl_ishlinskii.weights.2"], [0.1]))
    mirror = read(PLAYS + table(["prandtl_ishlinskii.weights"], [0.1]))
    weights = mirror_spread.draws(mirror, 1, 0)[0].prandtl_ishlinskii.weights_rad_v
    assert weights[1] == 0.0
    assert weights[0] / weights[2] == pytest.approx(3.0)
    assert weights[0] != 60e-6


def test_a_correlation_of_two_decimals_is_repaired(read):
    """Three numbers on a plane: their correlation is singular, and rounding makes its smallest eigenvalue negative."""
    angles = np.array([0.0, 0.3, 1.3])
    rounded = np.round(np.cos(angles[:, None] - angles), 2)
    assert -0.01 < np.linalg.eigvalsh(rounded)[0] < -1e-4
    mirror = read(BOUC_WEN + table(THREE, [0.1, 0.2, 0.3], [float(rounded[i, j]) for i in range(3) for j in range(i)]))
    repaired = mirror_spread.relative_covariance(mirror)
    assert np.linalg.eigvalsh(repaired)[0] > -1e-15
    assert_allclose(np.sqrt(np.diag(repaired)), [0.1, 0.2, 0.3], rtol=1e-12)
    assert_allclose(repaired / np.outer([0.1, 0.2, 0.3], [0.1, 0.2, 0.3]), rounded, atol=0.01)


# ----------------------------------------------------------------------------------------------------------- drawing
NAMES = ["bouc_wen.d1", "bouc_wen.epsilon", "linear.poles.1", "linear.pole_dampings.1", "creep.weights"]
ERRORS = [0.01, 0.1, 0.002, 0.03, 0.12]
CORRELATION = [-0.6, 0.3, 0.1, 0.0, 0.2, -0.4, 0.4, 0.1, 0.0, -0.3]


def drawn_values(mirrors):
    return np.array(
        [
            [
                m.bouc_wen.d1_rad_v,
                m.bouc_wen.epsilon_rad_v,
                m.linear.poles_hz[0],
                m.linear.pole_dampings[0],
                m.creep.weights_rad_v[0],
            ]
            for m in mirrors
        ]
    )


@pytest.mark.promise("mirror-file-24")
@pytest.mark.promise("identify-25")
@pytest.mark.promise("mirror-file-60")
def test_the_draws_have_the_covariance_of_the_table(read):
    mirror = read(BOUC_WEN + table(NAMES, ERRORS, CORRELATION))
    count = 2000
    drawn = mirror_spread.draws(mirror, count, seed=3)
    values = drawn_values(drawn)
    given = np.array([80e-6, -30e-6, 150.0, 0.35, 2e-6])
    errors = np.array(ERRORS) * np.abs(given)
    between = np.eye(5)
    between[np.tril_indices(5, -1)] = CORRELATION
    between = np.maximum(between, between.T) + np.minimum(between, between.T) - np.eye(5)
    expected = errors[:, None] * between * errors
    assert within((np.cov(values.T), count), expected)
    assert not within((np.cov(values.T), count), 1.2 * expected)
    assert np.all(np.abs(values.mean(axis=0) - given) < 4.5 * errors / math.sqrt(count))
    for m in drawn[:20]:
        assert m.uncertainty is None
        assert m.creep.weights_rad_v[1] == pytest.approx(m.creep.weights_rad_v[0] / 2, rel=1e-12)
        assert m.linear.poles_hz[1] == 400.0
        kept = {"bouc_wen", "linear", "creep", "uncertainty"}
        assert m.model_dump(exclude=kept) == mirror.model_dump(exclude=kept)


def test_a_parameter_known_to_ten_digits_keeps_its_own_spread_beside_others_known_to_one(read):
    """Relative errors of 0.3, 1e-10 and 0.2: the variance of the second is 1e-19 of the covariance's size."""
    drawn = mirror_spread.draws(read(BOUC_WEN + table(THREE, [0.3, 1e-10, 0.2], [0.9, 0.1, -0.3])), 1000, seed=2)
    values = [(m.bouc_wen.d1_rad_v / 80e-6, m.bouc_wen.alpha_1_v / 1.5, m.bouc_wen.beta_1_v / 0.4) for m in drawn]
    factors = np.array(values) - 1.0
    assert_allclose(np.std(factors, axis=0), [0.3, 1e-10, 0.2], rtol=0.1)
    assert_allclose(np.corrcoef(factors.T)[np.tril_indices(3, -1)], [0.9, 0.1, -0.3], atol=0.1)


def test_the_first_draws_are_the_same_for_a_larger_count(read):
    mirror = read(BOUC_WEN + table(NAMES, ERRORS, CORRELATION))
    few, many = (mirror_spread.draws(mirror, count, seed=7) for count in (3, 10))
    assert many[:3] == few
    assert len({m.bouc_wen.d1_rad_v for m in many}) == 10
    assert mirror_spread.draws(mirror, 3, seed=8)[0] != few[0]
    assert mirror_spread.draws(mirror, 0, seed=7) == ()


def test_no_value_changes_its_sign_and_the_rest_is_the_normal_distribution_cut_off(read):
    mirror = read(PLAYS + table(["prandtl_ishlinskii.weights.3"], [0.9]))
    weights = np.array([m.prandtl_ishlinskii.weights_rad_v[2] for m in mirror_spread.draws(mirror, 2000, 1)]) / 20e-6
    cut = truncnorm(-1 / 0.9, np.inf, 1.0, 0.9)
    assert weights.min() > 0.0
    assert abs(weights.mean() - cut.mean()) < 4.5 * cut.std() / math.sqrt(2000)
    assert weights.std() == pytest.approx(cut.std(), rel=0.08)


def test_draws_keep_to_the_tables_own_checks(read):
    names = ["linear.pole_dampings.1", "bouc_wen.alpha", "bouc_wen.beta"]
    nearly = BOUC_WEN.replace("0.35, 1.0", "0.9, 1.0").replace('"0.4 1/V"', '"1.4 1/V"')
    drawn = mirror_spread.draws(read(nearly + table(names, [0.2, 0.2, 0.2])), 200, 1)
    dampings = np.array([m.linear.pole_dampings[0] for m in drawn])
    assert 0.95 < dampings.max() < 1.0
    share = np.array([m.bouc_wen.beta_1_v / m.bouc_wen.alpha_1_v for m in drawn])
    assert 0.95 < share.max() < 1.0
    assert share.min() > 0.0


@pytest.mark.parametrize(
    ("names", "errors", "words"),
    [
        (["bouc_wen.beta"], [1.0], r"because bouc_wen.beta would change its sign; give smaller"),
        (["linear.pole_dampings.1"], [1.0], r"because linear.pole_dampings item 1: .* is above 1.*; give smaller"),
        (["bouc_wen.alpha"], [1.0], r"because bouc_wen.alpha is not above the size of beta \(1.4 1/V\)"),
    ],
)
def test_an_uncertainty_that_no_mirror_has_is_refused_with_its_reason(read, monkeypatch, names, errors, words):
    """With one try each the first draw that is no mirror ends it."""
    monkeypatch.setattr(mirror_spread, "TRIES", 1)
    nearly = BOUC_WEN.replace("0.35, 1.0", "0.99, 1.0").replace('"0.4 1/V"', '"1.4 1/V"')
    mirror = read(nearly + table(names, errors))
    refusals = set()
    for seed in range(60):
        try:
            mirror_spread.draws(mirror, 1, seed)
        except ValueError as error:
            refusals.add(str(error))
    assert any(re.search(f'"m" leaves no mirror: none of 1 draws is one, 1 times {words}', each) for each in refusals)


@pytest.mark.promise("identify-25")
def test_the_spread_of_the_slow_gain_follows_from_the_table(read):
    weights = ["prandtl_ishlinskii.weights.1", "prandtl_ishlinskii.weights.3"]
    correlated = read(PLAYS + table(weights, [0.1, 0.2], [-0.8]))
    expected = math.sqrt(6**2 + 4**2 - 2 * 0.8 * 6 * 4) / 80
    assert mirror_spread.relative_spread(correlated) == pytest.approx(expected, rel=1e-12)
    drawn = gains(mirror_spread.draws(correlated, 2000, 2))
    assert drawn.std() / 80e-6 == pytest.approx(expected, rel=4.5 / math.sqrt(2 * 2000))
    assert mirror_spread.relative_spread(read(PLAYS + table(["prandtl_ishlinskii.weights"], [0.07]))) == pytest.approx(
        0.07
    )
    assert mirror_spread.relative_spread(read(BOUC_WEN + table(NAMES, ERRORS, CORRELATION))) == pytest.approx(0.01)
    assert mirror_spread.relative_spread(read(PLAYS + table(["linear.poles.1", "creep.weights"], [0.1, 0.2]))) == 0.0


def test_parameters_are_values_in_si_units_and_a_list_that_scales_together_is_its_factor(read):
    mirror = read(BOUC_WEN + table(NAMES, ERRORS))
    assert mirror_spread.parameter_units(mirror) == dict(zip(NAMES, ("rad/V", "rad/V", "Hz", "", ""), strict=True))
    assert mirror_spread.parameter_units(read(PLAYS + table(["prandtl_ishlinskii.weights.3"], [0.1]))) == {
        "prandtl_ishlinskii.weights.3": "rad/V"
    }
    assert_allclose(mirror_spread.values(mirror), [80e-6, -30e-6, 150.0, 0.35, 2e-6])
    own = np.array([80e-6, -30e-6, 150.0, 0.35, 1.0])
    normals = np.array([np.zeros(5), [1.0, -1.0, 0.5, 0.25, 2.0]])
    found = mirror_spread.parameters(mirror, normals, lambda row: iter(()))
    assert_allclose(found[0], own)
    assert_allclose(found[1] / own - 1.0, np.array(ERRORS) * normals[1], rtol=1e-9)
    assert mirror_spread.parameters(mirror, np.zeros((0, 5)), lambda row: iter(())).shape == (0, 5)
    for ask in (mirror_spread.parameter_units, mirror_spread.values, mirror_spread.relative_covariance):
        with pytest.raises(ValueError, match="has no table uncertainty"):
            ask(read(BOUC_WEN))


def test_a_row_that_is_no_mirror_is_drawn_again(read):
    mirror = read(BOUC_WEN + table(["linear.pole_dampings.1", "bouc_wen.d1"], [1.0, 0.5]))
    again = {0: [], 1: [[5.0, 0.0], [0.0, -2.0], [0.5, 1.0], [0.0, 0.0]]}
    found = mirror_spread.parameters(mirror, np.array([[1.0, 0.0], [3.0, 0.0]]), lambda row: iter(np.array(again[row])))
    assert_allclose(found, [[0.7, 80e-6], [0.525, 120e-6]])


def test_a_mirror_is_moved_by_factors_or_is_none(read):
    mirror = read(BOUC_WEN + table(NAMES, ERRORS))
    by = np.array([2.0, 0.5, 3.0, 2.0, 4.0])
    found = mirror_spread.moved(mirror, by)
    assert_allclose(drawn_values([found])[0], by * drawn_values([mirror])[0])
    assert found.creep.weights_rad_v == (8e-6, 4e-6)
    assert (found.uncertainty, found.linear.poles_hz) == (None, (450.0, 400.0))
    assert mirror_spread.moved(mirror, np.ones(5)) == mirror.model_copy(update={"uncertainty": None})
    for at, factor in ((0, 0.0), (4, 0.0), (1, -1.0), (3, 2.9)):  # 2.9 x 0.35 is no damping of a pair
        assert mirror_spread.moved(mirror, np.where(np.arange(5) == at, factor, 1.0)) is None
    with pytest.raises(ValueError, match="has no table uncertainty"):
        mirror_spread.moved(read(BOUC_WEN), np.ones(1))


# ------------------------------------------------------------------------------------------- written by identification
def written(read, found):
    return read(mirror_file_text(found, "m"))


def values_of(mirror):
    """Values of the parameters of an uncertainty, in its order; of a whole list its first item."""
    found = []
    for key in mirror.uncertainty.parameters:
        at = place(mirror, key)
        value = getattr(getattr(mirror, at.table), at.field)
        found.append(value[at.item or 0] if isinstance(value, tuple) else value)
    return np.array(found)


def covariance_of(mirror):
    """The covariance of the values that a table says, with nothing of the package but its reader."""
    given = mirror.uncertainty
    errors = np.array(given.standard_errors) * np.abs(values_of(mirror))
    return errors[:, None] * np.array(given.correlation_rows) * errors


DRIVE = truths.two_sines(4000)
GRID = threshold_grid(float(np.ptp(DRIVE[:2000])), 15)
NEIGHBOURS = np.array([5e-5, *[4e-6] * 14])


@pytest.fixture(scope="module")
def neighbours():
    record = truths.recorded(DRIVE, truths.plays(DRIVE, GRID, NEIGHBOURS), noise=3e-3)
    return identify([record], models=("prandtl_ishlinskii",))


@pytest.mark.promise("identify-25")
def test_neighbouring_weights_are_drawn_apart_and_their_sum_is_not(read, neighbours):
    """The standard error of the sum from the least squares themselves, by NumPy."""
    fit = neighbours.fit()
    mirror = written(read, neighbours)
    assert len(mirror.uncertainty.parameters) == 15
    states = np.array([truths.plays(DRIVE[:2000], [r], [1.0]) for r in GRID]).T
    own = np.column_stack([np.ones(2000), memory(DRIVE[:2000], 2000)])[lead(2000) :]
    states = states[lead(2000) :]
    states -= own @ np.linalg.lstsq(own, states)[0]
    inverse = np.linalg.inv(states.T @ states)
    total = fit.weights_rad_per_v.sum()
    of_sum = math.sqrt(inverse.sum() / np.diag(inverse)[4]) * fit.standard_errors_rad_per_v[4] / total

    assert mirror_spread.relative_spread(mirror) == pytest.approx(of_sum, rel=0.05)
    drawn = mirror_spread.draws(mirror, 400, seed=5)
    assert gains(drawn).std() / total == pytest.approx(of_sum, rel=4.5 / math.sqrt(800))
    each = np.array([m.prandtl_ishlinskii.weights_rad_v for m in drawn]).std(axis=0)
    assert each[1:].min() > 0.1 * 4e-6
    assert math.hypot(*each) / total > 10 * of_sum
    assert abs(gains(drawn).mean() / total - 1.0) < 5 * of_sum / 20


@pytest.mark.promise("hysteresis-13")
def test_the_covariance_of_a_bouc_wen_fit_comes_through_the_file(read):
    """Where the sensor falls d1, epsilon and beta have their signs turned, and correlations between the two kinds."""
    drives = [truths.two_sines(3000, freq_hz=f) for f in (2.0, 6.0)]
    parameters = (8e-5, 1e-5, -3e-5, 4e-3, 1.5, 0.4)
    signs = np.array([-1, 1, -1, 1, 1, -1])
    records = [truths.recorded(d, -truths.bouc_wen(d, 1000.0, parameters), seed=k) for k, d in enumerate(drives)]
    found = identify(records, models=("bouc_wen",))
    mirror = written(read, found)
    fit = found.fit()
    errors = fit.standard_errors / np.abs(fit.values)
    keep = [i for i, key in enumerate(PARAMETERS) if f"bouc_wen.{key}" in mirror.uncertainty.parameters]
    assert len(keep) >= 5
    assert errors.max() < 1.0
    assert_allclose(values_of(mirror), (signs * fit.values)[keep], rtol=1e-12)
    expected = (signs[:, None] * fit.covariance * signs)[np.ix_(keep, keep)]
    size = np.sqrt(np.diag(expected))
    assert_allclose(covariance_of(mirror) / np.outer(size, size), expected / np.outer(size, size), atol=0.01)


# ---------------------------------------------------------------------------------------------------------- joint fits
ROOTS = LinearPoles(Roots((40.0, 150.0), (1.0, 0.35)), Roots((60.0,), (1.0,)), 3.0)


def as_chosen(result, fit):
    """An identification whose only fit is this one, with the band of a linear part."""
    return replace(
        result,
        fits=(fit,),
        scores=(replace(result.score(), model=fit.name),),
        chosen=fit.name,
        linear=SimpleNamespace(excited_hz=(1.0, 400.0)),
    )


def made_fit(name, model, covariance_of, *, creep=NO_CREEP, linear=None):
    """A joint fit that was not searched for: the values of the model, and a covariance of their names and sizes."""
    form = FORMS[name]
    structure = one_axis(name, model, linear=linear, creep=creep, free=form.free)
    names, values = zip(*((p.name, p.start) for p in structure.parameters), strict=True)
    covariance = covariance_of(list(names), np.array(values))
    fit = PlantFit(structure, np.array(values), covariance, 1.0, 1.0, (), np.zeros((1, 1)), (), (0.0,), 1, 1, True)
    axis = structure.parts(fit.values)
    return JointFit(name, form, structure, fit, fit.mirror, *axis, 200.0, Units(), 0.0, 0.0, 1000)


def random_covariance(errors, seed=1):
    """Relative errors of some size, any correlation."""

    def of(names, values):
        mixed = philox(seed).standard_normal((len(names), 3 * len(names)))
        between = np.corrcoef(mixed)
        size = errors * np.abs(values)
        size[values == 0.0] = errors * 1e-6
        return size[:, None] * between * size

    return of


@pytest.mark.promise("identify-25")
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_every_part_of_a_joint_fit_comes_through_the_file(read, neighbours, sign):
    """The damping of real roots and what was not fitted are held; a weight of 0 counts with its neighbour."""
    plays = PrandtlIshlinskii((0.0, 0.6, 1.2, 1.9), tuple(sign * w for w in (6e-5, 1.5e-5, 0.0, 1e-5)), 1e-3, 200.0)
    creep = Creep((sign * 2e-6,) * 2, (0.1, 1.0))
    fit = made_fit("prandtl_ishlinskii_rate_creep", plays, random_covariance(0.04), creep=creep, linear=ROOTS)
    text = mirror_file_text(as_chosen(neighbours, fit), "m")
    assert ("sign was flipped" in text) == (sign < 0)
    mirror = read(text)
    weights = [f"prandtl_ishlinskii.weights.{i}" for i in (1, 2, 4)]
    others = ["prandtl_ishlinskii.widening", "creep.weights.1", "creep.weights.2", "linear.poles.1", "linear.poles.2"]
    assert set(mirror.uncertainty.parameters) == {*weights, *others, "linear.pole_dampings.2", "linear.zeros.1"}

    kept = fit.fit.values != 0.0
    together = np.eye(kept.size)
    together[1, 2] = 1.0  # the second weight stands for the third as well, which is 0
    left = (together @ fit.fit.covariance @ together.T)[np.ix_(kept, kept)]
    order = [*weights, *others, "linear.pole_dampings.2", "linear.zeros.1"]
    place_of = [mirror.uncertainty.parameters.index(key) for key in order]
    turn = np.where(np.isin(np.arange(10), (0, 1, 2, 4, 5)), sign, 1.0)
    expected = turn[:, None] * left * turn
    assert_allclose(values_of(mirror)[place_of], turn * fit.fit.values[kept], rtol=1e-9)
    size = np.sqrt(np.diag(expected))
    got = covariance_of(mirror)[np.ix_(place_of, place_of)]
    assert_allclose(got / np.outer(size, size), expected / np.outer(size, size), atol=0.01)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_shares_of_alpha_are_propagated_with_their_correlation(read, neighbours, sign):
    """beta, gamma and eta are fitted over alpha; a sensor turned over turns d1, epsilon, beta and gamma."""
    model = BoucWen(sign * 8e-5, 1e-5, sign * -3e-5, 4e-3, 1.5, sign * 0.4, 200.0, 5.0, sign * 0.25, -0.15)
    fit = made_fit("bouc_wen_asymmetric", model, random_covariance(0.03))
    mirror = read(mirror_file_text(as_chosen(neighbours, fit), "m"))
    names = [p.name for p in fit.structure.parameters]
    at = dict(zip(names, fit.fit.values, strict=True))
    turned = {"d1": sign, "epsilon": sign, "beta": sign, "gamma": sign}
    jacobian = np.zeros((len(names), len(names)))
    for row, key in enumerate(mirror.uncertainty.parameters):
        short = key.removeprefix("bouc_wen.")
        share = f"{short} over alpha"
        scale = turned.get(short, 1.0)
        if share in names:
            jacobian[row, names.index(share)] = scale * at["alpha"]
            jacobian[row, names.index("alpha")] = scale * at[share]
        else:
            jacobian[row, names.index(short)] = scale
    expected = jacobian @ fit.fit.covariance @ jacobian.T
    size = np.sqrt(np.diag(expected))
    assert size.min() > 0.0
    assert_allclose(covariance_of(mirror) / np.outer(size, size), expected / np.outer(size, size), atol=0.01)
    assert "bouc_wen.exponent" not in mirror.uncertainty.parameters


@pytest.mark.promise("identify-25")
def test_a_share_at_its_bound_is_held_so_that_beta_goes_with_alpha(read, neighbours):
    fit = made_fit(
        "bouc_wen_joint", BoucWen(8e-5, 1e-5, -3e-5, 4e-3, 1.5, 0.999 * 1.5, 200.0), random_covariance(0.03, 2)
    )
    mirror = read(mirror_file_text(as_chosen(neighbours, fit), "m"))
    keys = mirror.uncertainty.parameters
    alpha, beta, d1 = (keys.index(f"bouc_wen.{key}") for key in ("alpha", "beta", "d1"))
    rows = np.array(mirror.uncertainty.correlation_rows)
    assert rows[alpha, beta] == pytest.approx(1.0, abs=1e-5)
    assert mirror.uncertainty.standard_errors[alpha] == mirror.uncertainty.standard_errors[beta]
    names = [p.name for p in fit.structure.parameters]
    kept = np.array([name != "beta over alpha" for name in names])
    left = np.linalg.inv(np.linalg.inv(fit.fit.covariance)[np.ix_(kept, kept)])
    error = math.sqrt(left[0, 0]) / 8e-5
    assert names[0] == "d1"
    assert mirror.uncertainty.standard_errors[d1] == pytest.approx(error, rel=5e-3)
    assert fit.fit.standard_errors[0] / 8e-5 > 1.02 * error


def opposed(errors, left):
    """Two weights whose sum is known to `left` times what each is, all else being nearly known."""

    def of(names, values):
        size = np.array(errors) * np.abs(values)
        between = np.eye(len(values))
        between[0, 1] = between[1, 0] = -1.0 + left**2 / 2
        return size[:, None] * between * size

    return of


@pytest.mark.promise("identify-25")
@pytest.mark.parametrize("left", [1e-2, 1e-3, 1e-4, 1e-5])
def test_the_file_has_the_digits_that_a_well_known_sum_needs(read, neighbours, left):
    weights = (3e-5, 3e-5, 1e-5)
    fit = made_fit(
        "prandtl_ishlinskii_joint", PrandtlIshlinskii((0.0, 0.1, 0.9), weights), opposed((0.21234, 0.21234, 1e-6), left)
    )
    text = mirror_file_text(as_chosen(neighbours, fit), "m")
    shares = np.array(weights) / sum(weights)
    relative = fit.fit.covariance / np.outer(weights, weights)
    expected = math.sqrt(shares @ relative @ shares)
    mirror = read(text)
    assert mirror_spread.relative_spread(mirror) == pytest.approx(expected, rel=0.06)
    assert mirror.uncertainty.standard_errors[0] == pytest.approx(0.21234, rel=5e-3)
    digits = len(re.search(r"standard_errors = \[0\.(\d+)", text)[1])
    assert digits == 3 if left >= 1e-2 else digits > 3


@pytest.mark.promise("identify-25")
def test_what_the_recordings_leave_open_is_cut_off_and_the_known_sum_is_kept(read, neighbours):
    """Two weights known to three times their size, their sum to a thousandth; a third is lost, its error counts."""
    weights = np.array([3e-5, 3e-5, 1e-9, 1e-5])
    plays = PrandtlIshlinskii((0.0, 0.1, 0.5, 0.9), tuple(weights.tolist()))
    fit = made_fit("prandtl_ishlinskii_joint", plays, opposed((3.0, 3.0, 500.0, 1e-4), 1e-3 / 3))
    mirror = read(mirror_file_text(as_chosen(neighbours, fit), "m"))
    assert [key[-1] for key in mirror.uncertainty.parameters] == ["1", "2", "4"]
    first, second, _ = mirror.uncertainty.standard_errors
    assert first == pytest.approx(math.sqrt(0.5), rel=1e-3)  # the open direction, of variance 18, ends at 1
    assert second == first
    expected = math.sqrt(fit.fit.covariance.sum()) / weights.sum()
    assert expected > 500e-9 / weights.sum()
    assert mirror_spread.relative_spread(mirror) == pytest.approx(expected, rel=0.06)
    drawn = mirror_spread.draws(mirror, 400, seed=1)
    assert gains(drawn).std() / weights.sum() == pytest.approx(expected, rel=0.06 + 4.5 / math.sqrt(800))
    each = np.array([m.prandtl_ishlinskii.weights_rad_v for m in drawn])
    assert each[:, 0].std() > 0.4 * 3e-5
    assert np.ptp(each[:, 2]) == 0.0


def test_a_fit_without_a_free_parameter_writes_no_uncertainty(read, neighbours):
    fit = made_fit(
        "prandtl_ishlinskii_joint", PrandtlIshlinskii((0.0,), (3e-5,)), lambda names, values: np.zeros((1, 1))
    )
    assert written(read, as_chosen(neighbours, fit)).uncertainty is None


# ---------------------------------------------------------------------------------------------------- from end to end
def response(freq_hz, weight, natural_hz, damping, normalise_hz=3.0):
    """Frequency response of a gain before a resonance whose magnitude is 1 at one frequency."""

    def resonance(f):
        return 1.0 / (1.0 - (f / natural_hz) ** 2 + 2j * damping * f / natural_hz)

    return weight * resonance(freq_hz) / abs(resonance(normalise_hz))


def test_frequency_responses_of_draws_spread_as_linear_propagation_predicts(read, neighbours):
    drive = truths.two_sines(1200, 1000.0, 8.0)
    record = truths.recorded(drive, truths.behind_resonance(6e-5 * drive, 1000.0), 1000.0, noise=1e-4)
    start = LinearPoles(Roots((140.0,), (0.4,)), Roots((), ()), 3.0)
    fit = fit_joint([record], "linear", Units(), linear=start, free_linear=True)
    mirror = written(read, as_chosen(neighbours, fit))
    assert len(mirror.uncertainty.parameters) == 3

    freq = np.array([1.0, 60.0, 120.0, 160.0, 300.0])
    values, covariance = fit.fit.values[:3], fit.fit.covariance[:3, :3]  # without the delay of the recording
    best = response(freq, *values)
    steps = np.diag(1e-5 * values)
    columns = [(response(freq, *(values + s)) - response(freq, *(values - s))) / s.sum() / 2 for s in steps]
    jacobian = np.array(columns).T / best[:, None]
    drawn = mirror_spread.draws(mirror, 400, seed=2)
    found = np.array(
        [
            g * frequency_response(linear_part(m.linear)[0], freq)[:, 0, 0]
            for g, m in zip(gains(drawn), drawn, strict=True)
        ]
    )
    for part in (np.real, np.imag):  # relative magnitude and phase, to first order
        predicted = np.sqrt(np.einsum("fi,ij,fj->f", part(jacobian), covariance, part(jacobian)))
        spread = part(found / best - 1.0).std(axis=0)
        assert_allclose(spread, predicted, rtol=4.5 / math.sqrt(800), atol=2e-6)
        assert predicted.max() > 1e-3


# ------------------------------------------------------------------------------------------------- numbers all unlike
SIX = [
    *("creep.weights", "bouc_wen.delta", "linear.poles.2"),
    *("bouc_wen.epsilon", "creep.time_constants.2", "linear.pole_dampings.1"),
]
SIX_ERRORS = [0.1, 0.2, 0.05, 0.3, 0.15, 0.07]
SIX_PAIRS = [0.5, -0.2, 0.1, 0.3, 0.0, 0.2, 0.0, 0.0, 0.1, 0.2, -0.3, 0.4, 0.0, 0.0, 0.0]


def test_parts_of_every_table_are_known_and_moved_each_by_its_own_factor(read):
    mirror = read(BOUC_WEN + table(SIX, SIX_ERRORS, SIX_PAIRS))
    assert list(mirror_spread.parameter_units(mirror).items()) == list(
        zip(SIX, ["", "s/V", "Hz", "rad/V", "s", ""], strict=True)
    )
    assert_allclose(mirror_spread.values(mirror), [2e-6, 4e-3, 400.0, -30e-6, 1.0, 0.35], rtol=1e-12)
    found = mirror_spread.moved(mirror, np.array([2.0, 0.5, 1.25, 0.75, 1.5, 1.1]))
    assert_allclose(found.creep.time_constants_s, (0.1, 1.5), rtol=1e-12)
    assert_allclose(found.creep.weights_rad_v, (4e-6, 2e-6), rtol=1e-12)
    assert_allclose(found.linear.poles_hz, (150.0, 500.0), rtol=1e-12)
    assert_allclose(found.linear.pole_dampings, (0.385, 1.0), rtol=1e-12)
    changed = {"epsilon_rad_v": pytest.approx(-22.5e-6), "delta_s_v": pytest.approx(2e-3)}
    assert dict(found.bouc_wen) == dict(mirror.bouc_wen) | changed
    assert (found.travel_rad, found.bias_v, found.uncertainty) == (mirror.travel_rad, 5.0, None)


def test_the_covariance_of_factors_turns_with_the_sign_of_each_value(read):
    """Only epsilon is below 0: its correlations with the others change their sign, and no other."""
    found = mirror_spread.relative_covariance(read(BOUC_WEN + table(SIX, SIX_ERRORS, SIX_PAIRS)))
    correlation = np.eye(6)
    correlation[np.tril_indices(6, -1)] = SIX_PAIRS
    correlation += np.tril(correlation, -1).T
    signed = np.array(SIX_ERRORS) * [1, 1, 1, -1, 1, 1]
    assert_allclose(found, signed[:, None] * correlation * signed, atol=1e-15)


@pytest.mark.parametrize(
    ("names", "errors", "pairs", "spread"),
    [
        (
            ["prandtl_ishlinskii.weights.1", "creep.weights.2", "prandtl_ishlinskii.weights.3"],
            [0.2, 0.9, 0.4],
            [0.0, -0.5, 0.0],
            math.sqrt(0.15**2 + 0.1**2 - 0.15 * 0.1),
        ),
        (["prandtl_ishlinskii.weights", "linear.poles.1"], [0.3, 0.2], [0.5], 0.3),
        (["prandtl_ishlinskii.thresholds.2"], [0.3], None, 0.0),
    ],
)
def test_the_spread_of_the_gain_is_that_of_the_weights_by_their_shares(read, names, errors, pairs, spread):
    found = mirror_spread.relative_spread(read(PLAYS + table(names, errors, pairs)))
    assert found == pytest.approx(spread, rel=1e-9, abs=1e-12)


@pytest.mark.parametrize(
    ("text", "names", "factors"),
    [
        (BOUC_WEN, ["linear.pole_dampings.1", "bouc_wen.d1"], [2.9, 1.0]),
        (BOUC_WEN, ["bouc_wen.d1", "linear.poles.1"], [1.0, -0.5]),
        (BOUC_WEN, ["creep.time_constants.1"], [10.5]),
        (PLAYS, ["prandtl_ishlinskii.thresholds.2"], [2.5]),
        (BOUC_WEN, ["bouc_wen.beta"], [4.0]),  # 1.6 1/V, above alpha
    ],
)
def test_what_a_file_would_refuse_is_no_moved_mirror(read, text, names, factors):
    mirror = read(text + table(names, [0.5] * len(names)))
    assert mirror_spread.moved(mirror, np.array(factors)) is None
    assert mirror_spread.moved(mirror, np.ones(len(names))) is not None


@pytest.mark.parametrize(
    ("names", "factors", "moved"),
    [
        (["bouc_wen.d1"], [0.0], False),
        (["bouc_wen.d1"], [1e-3], True),
        (["bouc_wen.d1", "bouc_wen.delta"], [1.5, 0.05], True),
        (["linear.poles.1", "creep.weights"], [1.0, 0.0], False),
        (["linear.pole_dampings.1"], [0.01], True),
    ],
)
def test_a_factor_of_0_turns_a_value_and_a_small_one_does_not(read, names, factors, moved):
    found = mirror_spread.moved(read(BOUC_WEN + table(names, [0.5] * len(names))), np.array(factors))
    assert (found is not None) == moved


def test_what_refuses_most_draws_is_told_with_how_often(read, monkeypatch):
    """Of five draws two turn d1 and four a pole, one of them both; a sixth would be a mirror."""
    monkeypatch.setattr(mirror_spread, "TRIES", 5)
    mirror = read(BOUC_WEN + table(["bouc_wen.d1", "linear.poles.1"], [0.5, 0.5]))
    others = np.array([[0.0, -3.0], [0.0, -2.0], [-3.0, -3.0], [0.0, -4.0], [0.0, 0.0]])
    with pytest.raises(ValueError) as caught:
        mirror_spread.parameters(mirror, np.array([[-3.0, 0.0]]), lambda row: iter(others))
    assert str(caught.value) == (
        'the uncertainty of the mirror "m" leaves no mirror: none of 5 draws is one, 4 times because linear.poles.1 '
        "would change its sign; give smaller standard errors, or leave such a parameter out"
    )
    monkeypatch.setattr(mirror_spread, "TRIES", 6)
    found = mirror_spread.parameters(mirror, np.array([[-3.0, 0.0]]), lambda row: iter(others))
    assert_allclose(found, [[80e-6, 150.0]])


def test_the_reason_that_is_told_is_that_of_the_first_draw_that_was_refused_for_it(read, monkeypatch):
    monkeypatch.setattr(mirror_spread, "TRIES", 3)
    mirror = read(BOUC_WEN + table(["linear.pole_dampings.1"], [1.0]))
    with pytest.raises(ValueError) as caught:
        mirror_spread.parameters(mirror, np.array([[3.0]]), lambda row: iter(np.array([[4.0], [5.0]])))
    assert "3 times because linear.pole_dampings item 1: " in str(caught.value)
    assert "1.4" in str(caught.value) and "1.75" not in str(caught.value) and "2.1" not in str(caught.value)


def test_a_list_that_begins_with_0_has_the_value_and_the_sign_of_its_first_item_that_is_not(read):
    mirror = read(PLAYS + table(["prandtl_ishlinskii.thresholds", "linear.poles.2"], [0.3, 0.2], [0.5]))
    assert_allclose(mirror_spread.values(mirror), [1.0, 400.0])
    assert_allclose(mirror_spread.relative_covariance(mirror), [[0.09, 0.03], [0.03, 0.04]], rtol=1e-12)
    found = mirror_spread.moved(mirror, np.array([1.5, 1.0]))
    assert found.prandtl_ishlinskii.thresholds_v == (0.0, 1.5, 3.0)
