"""`fit_frequency_response`: recovery within its error bars, stability, order, weights, holds, delay, and refusals."""

import re
import sys
from dataclasses import replace
from types import SimpleNamespace

import control as python_control
import numpy as np
import pytest

from microrad.core import lti
from microrad.core.units import LEAST, MOST
from microrad.lab.identify import IdentificationError, fit_frequency_response
from microrad.lab.identify.linear import frequency_fit, response_table
from microrad.lab.identify.linear.elements import ElementEquations
from microrad.lab.identify.linear.modal import ModalModel
from microrad.lab.identify.linear.polish import FrequencyEquations, fit_outputs, normal_equations, pack, polish, unpack
from microrad.lab.identify.linear.uncertainty import _slopes, transfer_matrix
from microrad.lab.identify.linear.vector_fitting import sketched, vector_fit
from microrad.lab.identify.statistics import central_differences
from places import ROOT, benchmark
from response_tables import (
    TABLES,
    anti_resonances,
    close_poles,
    heavy_damping,
    mirror_two_axes,
    noisy,
    one_drive_three_sensors,
    one_resonance,
    oscillators,
    real_poles,
    slow_response,
    three_axes,
    wide_range,
)

FREQ_HZ = np.geomspace(10, 1000, 60)
FLAT = np.ones(60, dtype=complex)


def drawn_again(table, seed):
    return noisy(table.true_response, table.standard_error, np.random.default_rng(1000 + seed))


def ways(found, truth):
    """Of each true pole the way to the nearest found one, and which that is."""
    apart = np.abs(found[:, None] - truth[None, :])
    return apart.min(axis=0), apart.argmin(axis=0)


# ------------------------------------------------------------------------------------------------------------- recovery
@pytest.mark.promise("identify-32")
@pytest.mark.parametrize("build", TABLES)
@pytest.mark.promise("identify-58")
def test_without_noise_the_system_is_recovered_to_rounding(build):
    table = build()
    fit = fit_frequency_response(table.freq_hz, table.true_response, table.order)
    assert fit.relative_rms_error < 1e-11
    distance, _ = ways(fit.poles_rad_s, table.poles)
    assert (distance < 1e-5 * np.abs(table.poles)).all()  # poles of small residues have the fewest digits
    assert np.abs(fit.system.D - table.system[3]).max() < 1e-6 * np.abs(table.true_response).max()
    np.testing.assert_allclose(
        lti.frequency_response(fit.system, table.freq_hz), fit.response(table.freq_hz), rtol=1e-6
    )


@pytest.mark.promise("identify-33")
@pytest.mark.parametrize("given", [True, False], ids=["errors given", "from the residual"])
@pytest.mark.parametrize("build", [one_resonance, real_poles, heavy_damping, one_drive_three_sensors])
@pytest.mark.promise("identify-58")
def test_standard_errors_cover_the_truth_as_often_as_they_say(build, given):
    """Noise of one size in each element: what is left of it is its estimate where it is not given."""
    table = build()
    level = np.full_like(table.standard_error, np.median(table.standard_error))
    gain = slow_response(table.system, np.zeros(1))[0].real
    squared, held = [], []
    for seed in range(40):
        response = noisy(table.true_response, level, np.random.default_rng(seed))
        error = level if given else None
        fit = fit_frequency_response(table.freq_hz, response, table.order, standard_error=error)
        distance, which = ways(fit.poles_rad_s, table.poles)
        squared.append((distance / fit.known.poles_error_rad_s[which]) ** 2)
        held.append(np.abs(fit.known.dc_gain - gain) < 1.96 * fit.known.dc_gain_error)
    assert 0.75 < np.mean(squared) < 1.3  # of complex normal errors in their deviation 1
    assert 0.89 <= np.mean(held) <= 1.0


@pytest.mark.promise("identify-33")
def test_zeros_have_their_errors_too():
    table = mirror_two_axes()
    system = lti.StateSpace(*table.system)
    truth = lti.zeros(system)
    squared = []
    for seed in range(25):
        response = drawn_again(table, seed)
        fit = fit_frequency_response(table.freq_hz, response, table.order, standard_error=table.standard_error)
        distance, which = ways(fit.zeros_rad_s, truth)
        squared.append((distance / fit.known.zeros_error_rad_s[which]) ** 2)
    assert 0.7 < np.mean(squared) < 1.35


def test_zeros_of_a_sampled_response_are_known_up_to_half_the_rate():
    table = anti_resonances()
    fit = fit_frequency_response(table.freq_hz, table.true_response, table.order)
    highest = np.abs(fit.known.zeros_rad_s).max()
    for share, kept in ((0.49, True), (0.51, False), (0.9, False)):
        known = replace(fit, rate_hz=highest / (2 * np.pi) / share).known
        assert bool(np.isclose(np.abs(known.zeros_rad_s), highest).any()) is kept


def test_the_gain_at_the_lowest_frequency_and_its_error():
    table = heavy_damping()
    fit = fit_frequency_response(table.freq_hz, table.response, table.order, standard_error=table.standard_error)
    off = (fit.known.edge_gain - np.abs(table.true_response[0])) / fit.known.edge_gain_error
    assert np.abs(off).max() < 3.5
    assert (fit.known.edge_gain_error < table.standard_error[0]).all()  # all frequencies say more than one


@pytest.mark.parametrize(
    "build", [anti_resonances, heavy_damping, close_poles, mirror_two_axes, one_drive_three_sensors]
)
def test_the_distance_to_the_table_is_least(build):
    """A search that goes on to rounding gains less than a hundredth of what a standard error is worth."""
    table = build()
    fit = fit_frequency_response(table.freq_hz, table.response, table.order, standard_error=table.standard_error)
    weight = np.sqrt(2) / table.standard_error
    equations = ElementEquations(table.freq_hz, table.response, weight, "band-limited", None)
    cost = float(np.sum(np.abs(weight * fit.residual) ** 2))
    assert cost == pytest.approx(normal_equations(equations, fit.modes)[2], rel=1e-9)
    gained = cost - polish(equations, fit.modes, iterations=100, tolerance=1e-12).cost
    assert -1e-9 * cost < gained < 0.01  # the two sums of squares are added up in another order


# ------------------------------------------------------------------------------------------------------------ stability
@pytest.mark.promise("identify-33")
@pytest.mark.parametrize("build", TABLES)
def test_fits_are_stable_and_leave_the_noise(build):
    table = build()
    fit = fit_frequency_response(table.freq_hz, table.response, table.order, standard_error=table.standard_error)
    assert (np.linalg.eigvals(fit.system.A).real < 0).all()
    assert fit.order == table.order == len(fit.system.A)
    assert 0.8 < fit.chi_square < 1.15
    assert (
        np.abs(fit.residual - (table.response - fit.response(table.freq_hz))).max()
        < 1e-12 * np.abs(table.response).max()
    )
    error = np.linalg.norm(fit.residual) / np.linalg.norm(table.response)
    assert fit.relative_rms_error == pytest.approx(error, rel=1e-12)


@pytest.mark.parametrize("order", [1, 2, 5, 12])
def test_what_is_unstable_or_nothing_but_noise_gives_a_stable_model(order):
    s = 2j * np.pi * FREQ_HZ
    noise = np.random.default_rng(1).standard_normal((60, 2, 2)) + 0j
    for response in (1 / (s - 300.0) + 1 / (s + 800.0), np.exp(-s * 3e-3), noise, 0 * FLAT + 2.0):
        fit = fit_frequency_response(FREQ_HZ, response, order)
        assert (np.linalg.eigvals(fit.system.A).real < 0).all()
        assert np.isfinite(fit.response(FREQ_HZ)).all()


# ---------------------------------------------------------------------------------------------------------------- order
@pytest.mark.promise("identify-33")
@pytest.mark.parametrize("build", [one_resonance, real_poles, heavy_damping, close_poles, wide_range, mirror_two_axes])
def test_the_scan_finds_the_true_order_and_says_why(build):
    table = build()
    fit = fit_frequency_response(table.freq_hz, table.response, standard_error=table.standard_error)
    assert fit.order == table.order
    assert fit.reason.startswith(f"order {table.order} has the least criterion")
    assert [score.order for score in fit.scan] == list(range(1, table.order + 7))  # until six in a row gain nothing
    score = fit.scan[fit.order - 1]
    assert score.output_error_rms == pytest.approx(np.sqrt(np.mean(np.abs(fit.residual) ** 2)), rel=1e-9)


@pytest.mark.promise("identify-33")
def test_several_orders_are_compared_and_one_is_taken_as_it_is():
    table = one_resonance()
    done = []
    fit = fit_frequency_response(table.freq_hz, table.response, [4, 1, 2], on_progress=lambda *step: done.append(step))
    assert [score.order for score in fit.scan] == [1, 2, 4]
    assert fit.order == 2
    assert "no standard errors were given, so the variance is the least that any of these orders leaves" in fit.reason
    assert done == [(1, 3, "order 1"), (2, 3, "order 2"), (3, 3, "order 4")]
    one = fit_frequency_response(table.freq_hz, table.response, np.int64(3))
    assert (one.order, one.scan, one.reason) == (3, (), "order 3 was given")


# -------------------------------------------------------------------------------------------------------------- weights
@pytest.mark.promise("identify-34")
def test_weights_decide_where_the_error_is():
    table = wide_range()
    known = fit_frequency_response(table.freq_hz, table.response, 5, standard_error=table.standard_error)
    alike = fit_frequency_response(table.freq_hz, table.response, 5)
    high = table.freq_hz > 500  # the resonance, a thousandth of what is left of at low frequencies
    error = [np.abs(f.response(table.freq_hz) / table.true_response - 1)[high].max() for f in (known, alike)]
    assert error[0] < 2e-3
    assert error[1] > 20 * error[0]


@pytest.mark.promise("identify-34")
def test_a_frequency_of_large_error_does_not_count():
    table = one_resonance()
    spoilt, error = table.response.copy(), table.standard_error.copy()
    spoilt[50] += 100.0
    error[50] = 1e4
    fit = fit_frequency_response(table.freq_hz, spoilt, 2, standard_error=error)
    without = np.delete(np.arange(200), 50)
    other = fit_frequency_response(
        table.freq_hz[without], table.response[without], 2, standard_error=table.standard_error[without]
    )
    np.testing.assert_allclose(fit.poles_rad_s, other.poles_rad_s, rtol=1e-8)
    one_each = fit_frequency_response(table.freq_hz, spoilt[:, 0, 0], 2, standard_error=error[:, 0, 0])
    np.testing.assert_allclose(one_each.poles_rad_s, fit.poles_rad_s, rtol=1e-12)


@pytest.mark.promise("identify-34")
def test_the_result_says_what_its_errors_rest_on():
    table = anti_resonances()
    fit = fit_frequency_response(table.freq_hz, table.response, 6)
    assert fit.errors_from.startswith("the residual: no standard errors were given")
    assert any("where the response is large" in text for text in fit.warnings)  # the noise is a share of the response
    given = fit_frequency_response(table.freq_hz, table.response, 6, standard_error=table.standard_error)
    assert given.errors_from.startswith("the standard errors given; chi-square per degree of freedom is 1.0")
    assert given.warnings == ()
    small = fit_frequency_response(table.freq_hz, table.response, 6, standard_error=table.standard_error / 4)
    assert "times 4.0" in small.errors_from
    assert "the model leaves 4.0" in small.warnings[0]
    np.testing.assert_allclose(small.known.poles_error_rad_s, given.known.poles_error_rad_s, rtol=0.05)


@pytest.mark.promise("identify-34")
def test_noise_that_is_not_alike_makes_the_order_too_high_without_its_errors():
    table = anti_resonances()
    fit = fit_frequency_response(table.freq_hz, table.response)
    assert fit.order > table.order
    assert any("where the response is large" in text for text in fit.warnings)
    known = fit_frequency_response(table.freq_hz, table.response, standard_error=table.standard_error)
    assert known.order == table.order


@pytest.mark.promise("identify-33")
def test_poles_beyond_the_table_are_named():
    table = real_poles()
    middle = (table.freq_hz > 30) & (table.freq_hz < 3000)
    fit = fit_frequency_response(table.freq_hz[middle], table.true_response[middle], 4)
    (text, *_) = fit.warnings
    assert text.startswith("poles at 1, 10 Hz outside the measured band, 30.")
    assert "the table shows only the flank" in text


# ------------------------------------------------------------------------------------------------------- hold and delay
@pytest.mark.promise("identify-35")
@pytest.mark.parametrize("hold", ["zero-order", "first-order"])
def test_a_sampled_table_gives_the_continuous_system_behind_its_hold(hold):
    rate_hz, freq = 5000.0, np.linspace(5, 2400, 300)
    A, B, C, D = oscillators([90, 900], [0.02, 0.05], [1.0, 0.3])
    Ad, B0, B1 = lti.first_order_hold(A, B, 1 / rate_hz)
    if hold == "zero-order":
        B0, B1 = B0 + B1, 0 * B1
    z = np.exp(2j * np.pi * freq / rate_hz)
    sampled = np.array([C @ np.linalg.solve(p * np.eye(4) - Ad, B0 + p * B1) + D for p in z])
    fit = fit_frequency_response(freq, sampled, 4, hold=hold, rate_hz=rate_hz)
    np.testing.assert_allclose(np.sort_complex(fit.poles_rad_s), np.sort_complex(np.linalg.eigvals(A)), rtol=1e-8)
    np.testing.assert_allclose(fit.response(freq), sampled, rtol=1e-6, atol=1e-9)
    exact = slow_response((A, B, C, D), freq)
    assert np.abs(lti.frequency_response(fit.system, freq) - exact).max() < 1e-7 * np.abs(exact).max()


@pytest.mark.promise("identify-37")
def test_strictly_proper():
    table = mirror_two_axes()
    fit = fit_frequency_response(table.freq_hz, table.true_response, 8, strictly_proper=True)
    assert not fit.system.D.any()
    assert fit.relative_rms_error > 0.1  # of a system that has a direct term
    proper = fit_frequency_response(table.freq_hz, table.true_response - table.system[3], 8, strictly_proper=True)
    assert proper.relative_rms_error < 1e-9


@pytest.mark.promise("identify-36")
def test_a_delay_is_found_with_its_error():
    table, delay_s = mirror_two_axes(), 1e-4
    turn = np.exp(-2j * np.pi * table.freq_hz * delay_s)[:, None, None]
    off = []
    for seed in range(1):
        response = drawn_again(table, seed) * turn
        fit = fit_frequency_response(table.freq_hz, response, 8, standard_error=table.standard_error, delay=True)
        off.append((fit.delay_s - delay_s) / fit.known.delay_error_s)
        assert 3e-8 < fit.known.delay_error_s < 7e-8
        assert fit.relative_rms_error < 0.011
    assert np.abs(off).max() < 3.5
    assert fit_frequency_response(table.freq_hz, table.response, 8).delay_s == 0.0


@pytest.mark.promise("identify-36")
def test_a_delay_that_the_table_leaves_open_is_said():
    """Modes without a direct term: a short delay changes their gains and nothing else."""
    table = anti_resonances()
    fit = fit_frequency_response(table.freq_hz, table.true_response, 6, standard_error=table.standard_error, delay=True)
    assert fit.delay_s < 1e-4
    assert "the table does not fix the delay: its standard error is" in fit.warnings[0]


# ------------------------------------------------------------------------------------------------------- python-control
@pytest.mark.promise("identify-33")
def test_round_trip_to_python_control():
    table = three_axes()
    fit = fit_frequency_response(table.freq_hz, table.response, 12)
    system = fit.to_control()
    assert isinstance(system, python_control.StateSpace)
    assert system.isctime()
    response = python_control.frequency_response(system, 2 * np.pi * table.freq_hz).complex
    np.testing.assert_allclose(np.moveaxis(response, 2, 0), fit.response(table.freq_hz), rtol=1e-8, atol=1e-10)
    back = fit_frequency_response(table.freq_hz, np.moveaxis(response, 2, 0), 12)
    np.testing.assert_allclose(np.sort_complex(back.poles_rad_s), np.sort_complex(fit.poles_rad_s), rtol=1e-6)


def test_without_python_control_it_says_how_to_install_it(monkeypatch):
    fit = fit_frequency_response(FREQ_HZ, 1 / (1 + 1j * FREQ_HZ / 100), 1)
    monkeypatch.setitem(sys.modules, "control", None)
    with pytest.raises(IdentificationError, match=r"python-control is not installed.*pip install.*\[control\]"):
        fit.to_control()


# ---------------------------------------------------------------------------------------------------------------- page
@pytest.mark.promise("identify-32", "identify-33")
def test_the_example_of_the_page_prints_what_stands_below_it(tmp_path, monkeypatch, capsys):
    table = anti_resonances()
    response = table.response[:, 0, 0]
    columns = np.column_stack([table.freq_hz, np.abs(response), np.degrees(np.angle(response))])
    np.savetxt(tmp_path / "bode.csv", columns, delimiter=",", header="frequency,gain,phase", comments="")
    monkeypatch.chdir(tmp_path)
    page = (ROOT / "docs" / "identify.md").read_text(encoding="utf-8")
    ((code, printed),) = re.findall(
        r"```python\n([^`]*fit_frequency_response[^`]*)```\n\n```text\n(.*?)```", page, re.DOTALL
    )
    exec(code, {})
    assert capsys.readouterr().out == printed


# ------------------------------------------------------------------------------------------------------------- refusals
def spoilt(values, at, value):
    values = np.array(values)
    values[at] = value
    return values


@pytest.mark.parametrize(
    ("freq", "response", "words", "message"),
    [
        (FREQ_HZ, FLAT[:50], {}, "the response has 50 rows and there are 60 frequencies; give one row for each"),
        (
            FREQ_HZ[:4],
            FLAT[:4],
            {"orders": 5},
            "4 frequencies cannot fix 5 poles; give at least 6 frequencies or a lower",
        ),
        (FREQ_HZ[:6], FLAT[:6], {"orders": 5, "delay": True}, "order 5 has 12 numbers, and 6 frequencies give 12 real"),
        (
            FREQ_HZ,
            spoilt(FLAT, 7, np.nan),
            {},
            f"the response at {FREQ_HZ[7]:g} Hz is not finite; leave that frequency",
        ),
        (spoilt(FREQ_HZ, 7, np.inf), FLAT, {}, "frequency 8 is inf, which is not finite; leave it out"),
        (
            spoilt(FREQ_HZ, 7, 10.0),
            FLAT,
            {},
            "frequency 8, 10 Hz, does not lie above the one before it.*sort the table",
        ),
        (FREQ_HZ - 11.0, FLAT, {}, "frequency 1 is -1 Hz, below 0; leave it out"),
        (np.zeros((2, 30)), FLAT, {}, r"frequencies have the shape \(2, 30\); give one list"),
        ([], [], {}, r"frequencies have the shape \(0,\); give one list"),
        (FREQ_HZ, FLAT.reshape(60, 1), {}, r"response has the shape \(60, 1\); give \(frequencies,\) for one element"),
        (FREQ_HZ, np.zeros((60, 0, 2)), {}, r"response has the shape \(60, 0, 2\); give"),
        (FREQ_HZ, 0 * FLAT, {}, "the response is 0 at all frequencies, so there is nothing to fit"),
        (1e-200 * FREQ_HZ, FLAT, {}, "frequency 1 is .* Hz, below 1e-30; check the unit of the column"),
        ([0.0], [1.0], {}, "the only frequency is 0 Hz; give frequencies above it"),
        ([1.0], [1.0], {}, "1 frequency cannot fix 1 pole; give at least 2 frequencies or a lower order"),
        (FREQ_HZ, FLAT, {"orders": 0}, "the order is 0; give at least one pole"),
        (FREQ_HZ, FLAT, {"orders": [2, -1]}, "the order is -1; give at least one pole"),
        (FREQ_HZ, FLAT, {"orders": []}, "no order was given to choose from"),
        (
            FREQ_HZ,
            FLAT,
            {"standard_error": spoilt(np.ones(60), 3, 0.0)},
            f"the standard error at {FREQ_HZ[3]:g} Hz is 0; each must be above 0: leave out what was not measured",
        ),
        (FREQ_HZ, FLAT, {"standard_error": spoilt(np.ones(60), 3, np.inf)}, "the standard error at .* is not finite"),
        (
            FREQ_HZ,
            FLAT,
            {"standard_error": np.ones((60, 2))},
            r"standard errors have the shape \(60, 2\), the response \(60,\); give that shape, or one for each",
        ),
        (
            FREQ_HZ,
            FLAT,
            {"rate_hz": 2000.0},
            "the table reaches 1000 Hz, half the sample rate of 2000 Hz or more; leave",
        ),
        (FREQ_HZ, FLAT, {"rate_hz": 0.0}, "the sample rate is 0 Hz; give a rate above 0"),
        (FREQ_HZ, FLAT, {"rate_hz": np.inf}, "the sample rate is inf Hz; give a rate above 0"),
        (FREQ_HZ, FLAT, {"rate_hz": np.nan}, "the sample rate is nan Hz; give a rate above 0"),
        (FREQ_HZ, 1e31 * FLAT, {}, r"a magnitude below 1e-30 or above 1e\+30, and none has that in SI units"),
        (FREQ_HZ, 1e-31 * FLAT, {}, r"a magnitude below 1e-30 or above 1e\+30, and none has that in SI units"),
        (FREQ_HZ, FLAT, {"hold": "zero-order"}, "a zero-order hold needs the sample rate; give rate_hz"),
        (FREQ_HZ, FLAT, {"hold": "second-order"}, "hold 'second-order' is not known; use zero-order, first-order or"),
        (
            FREQ_HZ,
            FLAT,
            {"standard_error": spoilt(spoilt(np.ones(60), 3, 0.0), 9, -1.0)},
            f"the standard error at {FREQ_HZ[3]:g} Hz is 0; each must be above 0",
        ),
    ],
)
def test_refusals(freq, response, words, message):
    with pytest.raises(IdentificationError, match=message):
        fit_frequency_response(freq, response, **words)


@pytest.mark.parametrize("largest", [MOST, 2.0 * LEAST])
def test_a_response_of_any_size_that_has_a_unit_is_taken(largest):
    response = largest / (1 + 1j * FREQ_HZ / 2000.0)
    response *= largest / np.abs(response).max()
    fit = fit_frequency_response(FREQ_HZ, response, 1)
    np.testing.assert_allclose(fit.poles_rad_s, [-4000 * np.pi], rtol=1e-6)
    with pytest.raises(IdentificationError, match="none has that in SI units"):
        fit_frequency_response(FREQ_HZ, response * (1.001 if largest == MOST else 0.5), 1)


def test_a_frequency_of_zero_is_taken():
    freq = np.concatenate([[0.0], FREQ_HZ])
    fit = fit_frequency_response(freq, 1 / (1 + 1j * freq / 100), 1)
    np.testing.assert_allclose(fit.poles_rad_s, [-200 * np.pi], rtol=1e-9)


# ---------------------------------------------------------------------------------------- what the fast sums stand for
@pytest.mark.parametrize("direct", [True, False])
@pytest.mark.parametrize("apart", [0.0, 1e-9], ids=["one weight", "a weight for each element"])
def test_sums_by_element_are_those_of_the_rows(direct, apart):
    table = mirror_two_axes()
    found = vector_fit(table.freq_hz, table.response, 8).modes(most=1)
    weight = np.repeat(np.linspace(1, 3, table.freq_hz.size), 4).reshape(table.response.shape)
    power = (weight[:, 0, 0] ** 2)[:, None, None] * np.eye(2)
    turned = weight * (1 + apart * np.random.default_rng(0).standard_normal(weight.shape))
    rows = FrequencyEquations(table.freq_hz, table.response, power, "band-limited", None, direct=direct)
    sums = ElementEquations(table.freq_hz, table.response, turned, "band-limited", None, direct=direct)
    assert len(sums.squared) == (1 if apart == 0 else 4)
    (one, cost), (other, other_cost) = (fit_outputs(e, found.poles_rad_s, found.input_vectors) for e in (rows, sums))
    assert other_cost == pytest.approx(cost, rel=1e-6)
    np.testing.assert_allclose(other.output_vectors, one.output_vectors, rtol=1e-5, atol=1e-6)
    for a, b in zip(normal_equations(rows, one), normal_equations(sums, one), strict=True):
        np.testing.assert_allclose(b, a, rtol=1e-6, atol=1e-6 * np.abs(a).max())


@pytest.mark.parametrize("direct", [True, False])
def test_slopes_are_those_of_differences(direct):
    generator = np.random.default_rng(3)
    poles = np.array([-3.0 + 0j, -2.0 + 5j, -1.0 + 9j])
    b, c = (generator.standard_normal(shape) + 1j * generator.standard_normal(shape) for shape in ((3, 2), (3, 3)))
    b[0], c[:, 0] = b[0].real, c[:, 0].real
    model = ModalModel(poles, b, c, generator.standard_normal((3, 2)) * direct)
    points = np.array([0.0, 4j, -1.5 + 3j])
    theta = pack(model, direct)
    steps = np.full(theta.size, 1e-5)
    slow = central_differences(lambda moved: transfer_matrix(unpack(moved, model), points), theta, steps)
    np.testing.assert_allclose(_slopes(model, points, direct), slow, atol=1e-8)


@pytest.mark.parametrize("build", [one_resonance, heavy_damping, three_axes])
def test_the_sketch_is_near_the_vector_fit(build):
    table = build()
    one = np.ones((1, table.freq_hz.size))
    fast = sketched(table.freq_hz, table.response, one, np.ones((table.response[0].size, 1)), table.order)
    slow = vector_fit(table.freq_hz, table.response, table.order)
    assert fast.rms_error == pytest.approx(slow.rms_error, rel=0.01)
    distance, _ = ways(fast.poles_rad_s, slow.poles_rad_s)
    assert (distance < 0.1 * np.abs(slow.poles_rad_s.real)).all()


def test_poles_are_told_as_frequency_and_damping_with_their_errors():
    freq = np.geomspace(10.0, 3000.0, 200)
    s = 2j * np.pi * freq
    truth = 40.0 / (1 + 2 * 0.02 * s / 6000 + (s / 6000) ** 2) / (1 + s / 500)
    scores = []
    for seed in range(40):
        rng = np.random.default_rng(seed)
        noisy = truth + 0.2 * (rng.standard_normal(200) + 1j * rng.standard_normal(200)) / np.sqrt(2)
        fit = fit_frequency_response(freq, noisy, 3, standard_error=0.2)
        real, pair = fit.natural
        scores.append([(real.freq_hz - 500 / 2 / np.pi) / real.freq_error_hz])
        scores[-1] += [
            (pair.freq_hz - 6000 / 2 / np.pi) / pair.freq_error_hz,
            (pair.damping - 0.02) / pair.damping_error,
        ]
        assert (real.damping, real.damping_error) == (1.0, 0.0)
    spread = np.sqrt(np.mean(np.square(scores), axis=0))
    assert np.all(spread > 0.6) and np.all(spread < 1.4)
    assert repr(fit).startswith("<FrequencyResponseFit of order 3: 1 x 1 elements at 200 frequencies, ")


@pytest.mark.promise("identify-58")
def test_another_unit_of_the_response_moves_no_pole():
    table = heavy_damping()
    one, other = (fit_frequency_response(table.freq_hz, k * table.response, table.order) for k in (1.0, 1e6))
    np.testing.assert_allclose(other.poles_rad_s, one.poles_rad_s, rtol=1e-9)
    np.testing.assert_allclose(other.response(table.freq_hz), 1e6 * one.response(table.freq_hz), rtol=1e-9)


@pytest.mark.promise("identify-59", "identify-60")
@pytest.mark.parametrize(
    "build", [pytest.param(each, marks=[] if each is one_resonance else [pytest.mark.endurance]) for each in TABLES]
)
def test_beside_scikit_rf_it_leaves_what_the_page_says(build):
    """Ratios to three digits; its model has more states where ours is further from the table."""
    pytest.importorskip("skrf")
    bench, page = benchmark("frequency_response_fit"), (ROOT / "docs" / "identify.md").read_text(encoding="utf-8")
    of_rows = r"(?m)^\| (.*?) \| (\d+) \| (.*?) \| ([\d.]+) \| ([\d.]+) \|$"
    rows = {name: cells for name, *cells in re.findall(of_rows, page)}
    assert len(rows) == len(TABLES) == 10
    assert "unweighted" in page and "scikit-rf 2.2.0, both" in page and bench.DRAWS == 10
    table = build()
    order, noise, to_table, to_truth = rows[table.name]
    share, _, each = noise.partition(" %")
    size = np.abs(table.true_response)
    level = size if each == " of each entry" else np.sqrt(np.mean(size**2, axis=0))
    np.testing.assert_allclose(table.standard_error, np.broadcast_to(0.01 * float(share) * level, size.shape))
    found, *stable = bench.errors(table)
    ratios = found["ours"] / found["scikit-rf"]
    assert (table.order, stable) == (int(order), [True, True])
    assert ratios == pytest.approx([float(to_table), float(to_truth)], abs=1.5e-3)
    if ratios[0] > 1.0005:
        assert min(table.response.shape[1:]) in (2, 3) and 0.10 <= 1.0 - ratios[1] <= 0.18


@pytest.mark.parametrize(
    ("large", "small", "said"),
    [
        ((3e-3, 4e-3), (1e-3, 1e-3), "leaves 3.54 times as much where the response is large"),  # rms of 3 and 4 over 1
        ((3e-3, 3e-3), (1e-3, 1e-3), ""),
        ((1e-3, 1e-3), (3e-3, 4e-3), ""),
        ((1e-12, 1e-12), (0.0, 0.0), ""),
    ],
)
def test_noise_is_not_alike_where_more_than_three_times_as_much_is_left_of_what_is_large(large, small, said):
    response = np.array([10.0, -10.0, 1.0, 1.0j]).reshape(4, 1, 1)
    found = frequency_fit._uneven(response, np.array([*large, *small], dtype=complex).reshape(4, 1, 1))
    assert len(found) == bool(said) and said in "".join(found)
    assert frequency_fit._uneven(np.ones((4, 1, 1), dtype=complex), response) == ()


# --------------------------------------------------------------------------------------------------- tables, in full
def told_of(*given, form=("band-limited", None, False)):
    with pytest.raises(IdentificationError) as caught:
        response_table.checked(*given, form)
    return str(caught.value)


FIVE = np.array([1.0, 2.5, 4.0, 8.0, 9.0])
OF_TWO = np.arange(1.0, 31.0).reshape(5, 2, 3) * (1 + 0.5j)


@pytest.mark.parametrize(
    ("error", "expected"),
    [
        (0.25, np.full((5, 2, 3), 0.25)),
        ([1.0, 2.0, 3.0, 4.0, 5.0], np.arange(1.0, 6.0)[:, None, None] * np.ones((5, 2, 3))),
        (OF_TWO.real, OF_TWO.real),
        (None, None),
    ],
)
def test_errors_of_a_table_are_one_for_all_or_for_each_frequency_or_for_each_value(error, expected):
    table = response_table.checked(FIVE, OF_TWO, error, ("first-order", 19.0, True))
    if expected is None:
        assert table.standard_error is None
    else:
        np.testing.assert_array_equal(table.standard_error, expected)
    assert (table.hold, table.rate_hz, table.direct) == ("first-order", 19.0, False)
    assert table.response.shape == (5, 2, 3) and table.band_hz == (1.0, 9.0)


@pytest.mark.parametrize(
    ("freq", "values", "error", "message"),
    [
        (
            spoilt(FIVE, [2, 4], np.nan),
            OF_TWO,
            None,
            "frequency 3 is nan, which is not finite; leave it out.",
        ),
        (FIVE - 3.0, OF_TWO, None, "frequency 1 is -2 Hz, below 0; leave it out, positive ones say all."),
        (
            spoilt(FIVE, [0, 2], [0.0, 1e-31]),
            OF_TWO,
            None,
            "frequency 3 is 1e-31 Hz, below 1e-30; check the unit of the column.",
        ),
        (
            spoilt(FIVE, [1, 2], [1e-31, 1e-32]),
            OF_TWO,
            None,
            "frequency 2 is 1e-31 Hz, below 1e-30; check the unit of the column.",
        ),
        (
            spoilt(FIVE, 3, 4.0),
            OF_TWO,
            None,
            "frequency 4, 4 Hz, does not lie above the one before it, 4 Hz; sort the table by frequency and leave "
            "repeated ones out.",
        ),
        (
            FIVE,
            spoilt(OF_TWO, (slice(2, 4), 1, 2), np.inf),
            None,
            "the response at 4 Hz is not finite; leave that frequency out.",
        ),
        (
            FIVE,
            OF_TWO[:, 0],
            None,
            "the response has the shape (5, 3); give (frequencies,) for one element, or (frequencies, outputs, "
            "inputs).",
        ),
        (
            FIVE[:4],
            OF_TWO,
            None,
            "the response has 5 rows and there are 4 frequencies; give one row for each frequency.",
        ),
        (FIVE, "abcde", None, "the response is no array of complex numbers; give one for each frequency."),
        (
            FIVE,
            spoilt(OF_TWO, (4, 1, 2), 2e30j),
            None,
            "the response has a magnitude below 1e-30 or above 1e+30, and none has that in SI units; check its unit.",
        ),
        (
            FIVE,
            OF_TWO,
            spoilt(OF_TWO.real, ([1, 3], [1, 0], [2, 1]), [-0.5, -7.0]),
            "the standard error at 2.5 Hz is -0.5; each must be above 0: leave out what was not measured, or give a "
            "large error.",
        ),
        (
            FIVE,
            OF_TWO,
            spoilt(OF_TWO.real, (3, 0, 1), np.nan),
            "the standard error at 8 Hz is not finite; leave that frequency out.",
        ),
        (
            FIVE,
            OF_TWO,
            np.ones((5, 3, 2)),
            "the standard errors have the shape (5, 3, 2), the response (5, 2, 3); give that shape, or one for each "
            "frequency, (5,), or one for all.",
        ),
    ],
)
def test_a_fault_of_a_table_of_several_elements_is_told_in_full_at_the_first_place(freq, values, error, message):
    assert told_of(freq, values, error) == message


@pytest.mark.parametrize(
    ("form", "message"),
    [
        (
            ("zero-order", 18.0, False),
            "the table reaches 9 Hz, half the sample rate of 18 Hz or more; leave that out.",
        ),
        (("zero-order", -18.5, False), "the sample rate is -18.5 Hz; give a rate above 0."),
        (("first-order", None, False), "a first-order hold needs the sample rate; give rate_hz."),
        (
            ("first", 20.0, False),
            "hold 'first' is not known; use zero-order, first-order or band-limited.",
        ),
    ],
)
def test_a_hold_and_a_rate_that_a_table_cannot_have_are_told_in_full(form, message):
    assert told_of(FIVE, OF_TWO, None, form=form) == message


@pytest.mark.parametrize(
    ("proper", "delay", "order", "numbers", "most"),
    [(False, False, 4, 26, 4), (False, True, 10, 57, 4), (True, False, 5, 25, 4), (True, True, 6, 31, 4)],
)
def test_a_table_of_two_by_three_fixes_as_many_numbers_as_its_model_has(proper, delay, order, numbers, most):
    """Five for each state, six for a direct term, one for a delay; of sixty values one is to spare."""
    table = response_table.checked(FIVE, OF_TWO, None, ("band-limited", None, proper))
    assert table.parameters(order, delay) == numbers and table.most == most
    response_table.check_numbers(table, order, delay)
    short = table._replace(response=table.response[:2], freq_hz=FIVE[:2])
    with pytest.raises(IdentificationError) as caught:
        response_table.check_numbers(short, order, delay)
    assert str(caught.value) == (
        f"a model of order {order} has {numbers} numbers, and 2 frequencies give 24 real values; give more frequencies "
        "or a lower order."
    )


def test_a_table_of_one_element_and_ten_frequencies_has_no_order_of_ten():
    """Of 20 values: nine states and a delay have 19 numbers, and a direct term one more."""
    freq = np.arange(1.0, 11.0)
    assert response_table.checked(freq, freq, None, ("band-limited", None, True)).most == 9
    assert response_table.checked(freq, freq, None, ("band-limited", None, False)).most == 8
    assert response_table.checked(freq[:1], freq[:1], None, ("band-limited", None, True)).most == 1


def test_the_rows_of_a_table_are_turned_back_by_the_delay_and_weighed_by_its_errors():
    table = response_table.checked(FIVE, OF_TWO, OF_TWO.real, ("zero-order", 30.0, True))
    own = table.equations(0.02)
    np.testing.assert_allclose(own.response, OF_TWO * np.exp(2j * np.pi * FIVE * 0.02)[:, None, None])
    assert (own.hold, own.rate_hz, own.direct) == ("zero-order", 30.0, False)
    np.testing.assert_allclose(own.weight[:, :5], 2.0 / OF_TWO.real.reshape(5, 6).T ** 2)


# ------------------------------------------------------------------------------------------ numbers unlike each other
def test_what_errors_rest_on_and_what_speaks_against_a_model_is_told_in_full():
    assert frequency_fit._errors_from(False, 3.0, 3.0) == (
        "the residual: no standard errors were given, so the noise is taken to be what the model leaves"
    )
    assert frequency_fit._errors_from(True, 1.0, 0.98765) == (
        "the standard errors given; chi-square per degree of freedom is 0.988"
    )
    assert frequency_fit._errors_from(True, 6.25, 6.25) == (
        "the standard errors given, times 2.5 for what the model leaves beyond them"
    )
    assert frequency_fit._errors_from(True, 1.0, 12345.0).endswith("per degree of freedom is 12300")
    assert frequency_fit._errors_from(True, 1.5e6, 1.0).endswith(" times 1220 for what the model leaves beyond them")
    assert frequency_fit._misfit(1.5e6)[0].startswith("the model leaves 1220 times the standard errors given: ")
    assert frequency_fit._misfit(6.25) == (
        "the model leaves 2.5 times the standard errors given: the order is too low, the response is not that of a "
        "linear system, or the errors are too small; those of the model are larger by as much.",
    )
    assert frequency_fit._open_delay(0.00123, 40.0) == ()
    assert frequency_fit._open_delay(0.00126, 40.0) == (
        "the table does not fix the delay: its standard error is 0.0013 s, as poles and gains can take its part; fit "
        "without a delay, or measure to higher frequencies.",
    )
    table = np.array([1.0, 2.0, 10.0, 20.0j])
    assert frequency_fit._uneven(table, np.array([0.3, -0.1j, 1.2, 0.5])) == (
        "the model leaves 4.11 times as much where the response is large: the noise is not alike, and an order chosen "
        "from it is too high; give standard_error, such as 0.01 * abs(response).",
    )
    assert frequency_fit._uneven(table, np.array([0.3, -0.1j, 0.6, 0.7])) == ()
    assert frequency_fit._uneven(table, 1e-11 * np.array([0.0, 0.0, 1.2, 0.5])) == ()
    assert frequency_fit._uneven(np.ones(4), np.ones(4)) == ()


def polished_of(cost, rows=100, power=1e6, model=None):
    return SimpleNamespace(cost=cost, rows=rows, power=power, model=model)


def found_of(*costs, **words):
    """Fits of the orders 1, 2, ... that leave so much."""
    return {n: frequency_fit._Found(None, polished_of(cost, **words), 0.0) for n, cost in enumerate(costs, 1)}


def table_of(error=None, direct=True):
    return response_table.ResponseTable(
        np.arange(1.0, 6.0), np.ones((5, 2, 3)) + 0j, error, "band-limited", None, direct
    )


def test_the_variance_of_a_row_is_the_least_that_an_order_leaves_per_degree_of_freedom():
    """Of 100 rows: orders of 2 by 3 elements have five numbers a state, six direct terms and a delay."""
    table, fits = table_of(), found_of(880.0, 166.0, 156.0)
    assert frequency_fit._variance(table, fits, delay=True) == pytest.approx(156.0 / 78)
    assert frequency_fit._variance(table, fits, delay=False) == pytest.approx(156.0 / 79)
    assert frequency_fit._variance(table_of(np.ones((5, 2, 3))), fits, delay=True) == 1.0
    assert frequency_fit._variance(table, found_of(1e-30, 1e-40), delay=False) == pytest.approx(1e-22, abs=0.0)
    assert frequency_fit._variance(table, found_of(1e-30), delay=False) == pytest.approx(1e-30 / 89, abs=0.0)
    assert frequency_fit._variance(table, found_of(0.0), delay=False) == 1e-300
    assert frequency_fit._variance(table, found_of(5.0, rows=7), delay=False) == 5.0


@pytest.mark.parametrize(("costs", "ended"), [([9e3, 500.0] + [499.0] * 5, False), ([9e3, 500.0] + [499.0] * 6, True)])
def test_a_scan_ends_where_six_orders_in_a_row_gain_nothing(monkeypatch, costs, ended):
    monkeypatch.setattr(frequency_fit, "_residual", lambda table, found: np.array([3.0, 4.0j]))
    fits = found_of(*costs)
    assert frequency_fit._gains_nothing(table_of(), fits, True) is ended
    scores = frequency_fit._scores(table_of(), fits, True)
    variance = frequency_fit._variance(table_of(), fits, True)
    assert [score.order for score in scores] == list(fits)
    assert (scores[1].parameters, scores[1].freedom) == (17, 83)
    assert scores[1].chi_square == pytest.approx(500.0 / variance)
    assert scores[1].criterion == pytest.approx(500.0 / variance + 17 * np.log(100))
    assert scores[1].output_error_rms == pytest.approx(np.sqrt(12.5))


@pytest.mark.parametrize(("outputs", "inputs"), [(1, 1), (3, 1), (1, 2), (2, 3)])
def test_a_vector_fit_has_one_mode_for_each_pole_of_the_largest_part_of_its_residue(outputs, inputs):
    draw = np.random.Generator(np.random.Philox(4)).standard_normal((2, 3, outputs, inputs))
    residues = draw[0] + 1j * draw[1]
    residues[0] = residues[0].real
    poles = np.array([-3.0 + 0j, -1 + 9j, -2 + 20j])
    found = SimpleNamespace(
        poles_rad_s=np.concatenate([poles, poles[1:].conj()]),
        residues=np.concatenate([residues, residues[1:].conj()]),
        direct=draw[0, 0],
    )
    model = frequency_fit._one_each(found)
    assert model.poles_rad_s.tolist() == poles.tolist()
    for k, residue in enumerate(residues):
        left, size, right = np.linalg.svd(residue)
        expected = size[0] * np.outer(left[:, 0], right[0])
        np.testing.assert_allclose(np.outer(model.output_vectors[:, k], model.input_vectors[k]), expected, atol=1e-12)
    assert not model.input_vectors[0].imag.any() and model.direct.tolist() == draw[0, 0].tolist()


def test_the_delay_of_least_cost_is_sought_on_a_grid_and_then_between_its_neighbours():
    """A cost of two valleys in two periods of 4 Hz: the lower one, between two places of the grid."""
    asked = []

    def fitted(delay_s):
        asked.append(delay_s)
        return polished_of(min((delay_s - 0.31) ** 2, (delay_s - 0.05) ** 2 + 0.01))

    table = SimpleNamespace(band_hz=(1.0, 4.0), equations=lambda delay_s: delay_s)
    found = frequency_fit._best_delay(table, fitted)
    np.testing.assert_allclose(asked[:17], 0.03125 * np.arange(17))
    assert all(0.28125 <= each <= 0.34375 for each in asked[17:]) and len(asked) > 17
    assert found.delay_s == found.equations == pytest.approx(0.31, abs=1e-6)
    at_once = frequency_fit._best_delay(table, polished_of)
    assert at_once.delay_s == 0.0


@pytest.mark.parametrize(
    ("given", "cost", "variance", "chi_square"),
    [
        (True, 88.0, 1.0, 1.0),
        (True, 44.0, 1.0, 0.5),
        (True, 88.0 * 1.44, 1.0, 1.44),
        (True, 88.0 * 1.46, 1.46, 1.46),
        (False, 44.0, 0.5, None),
        (False, 0.0, 1e-300, None),
    ],
)
def test_what_is_left_counts_as_noise_beyond_three_standard_deviations_of_chi_square(given, cost, variance, chi_square):
    """Of 100 rows a state and a delay leave 88 degrees of freedom: 1.452."""
    model = ModalModel(np.array([-3.0 + 0j]), np.ones((1, 3)) + 0j, np.ones((2, 1)) + 0j, np.zeros((2, 3)))
    polished = SimpleNamespace(cost=cost, rows=100, power=1.0, model=model, normal="normal")
    table = table_of(np.ones((5, 2, 3)) if given else None)
    found = frequency_fit._Found(None, polished, 0.25)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(frequency_fit, "_with_delay", lambda found: "with delay")
        result = frequency_fit._result(table, found, True, [1, 2], "because")
    assert result.variance == pytest.approx(variance) and result.normal == "with delay"
    assert result.chi_square == (None if chi_square is None else pytest.approx(chi_square))
    assert (result.order, result.hold, result.scan, result.reason) == (1, "band-limited", (1, 2), "because")
    assert result.delay_s == 0.25 and not result.strictly_proper and result.band_hz == (1.0, 5.0)
    assert frequency_fit._result(table, found, False, (), "").normal == "normal"
    expected = (
        np.ones((5, 2, 3)) - model.response(table.freq_hz) * np.exp(-2j * np.pi * table.freq_hz * 0.25)[:, None, None]
    )
    np.testing.assert_allclose(result.residual, expected)
    share = np.linalg.norm(expected) / np.sqrt(30)
    assert (
        repr(result)
        == f"<FrequencyResponseFit of order 1: 2 x 3 elements at 5 frequencies, {share:.3g} of the table left>"
    )


def test_errors_of_gain_and_phase_and_of_poles_are_those_of_differences():
    """Two outputs and one drive, a real pole, a pair and a delay; every number with an error of its own."""
    draw = np.random.Generator(np.random.Philox(6))
    poles = np.array([-60.0 + 0j, -20 + 30j])
    model = ModalModel(
        poles, np.array([[1.0], [1 + 2j]]), np.array([[30.0, 5 - 2j], [7.0, 1 + 4j]]), np.array([[0.5], [1.0]]), 0.01
    )
    numbers = pack(model, True)
    root = (
        1e-3
        * draw.standard_normal((numbers.size + 4, numbers.size + 1))
        * np.append(np.maximum(np.abs(numbers), 1.0), 0.1)
    )
    freq = np.array([0.5, 4.0, 9.0])
    fit = frequency_fit.FrequencyResponseFit(
        model.state_space(),
        model,
        3,
        "band-limited",
        None,
        freq,
        model.response(freq),
        (),
        "",
        None,
        2.0,
        "",
        None,
        False,
    )
    covariance = root.T @ root
    vars(fit)["covariance"] = covariance
    gain, phase = fit.response_errors([3.0, 6.0])

    def quantities(v):
        own = replace(unpack(v[:-1], model), delay_s=float(v[-1])).response(np.array([3.0, 6.0])).ravel()
        return np.concatenate([np.abs(own), np.unwrap(np.angle(own / fit.response([3.0, 6.0]).ravel()))])

    at = np.append(numbers, 0.01)
    jacobian = central_differences(quantities, at, 1e-6 * np.maximum(np.abs(at), 0.01))
    errors = np.sqrt(np.einsum("ij,jk,ik->i", jacobian, covariance, jacobian))
    np.testing.assert_allclose(gain.ravel(), errors[:4], rtol=1e-4)
    np.testing.assert_allclose(phase.ravel(), errors[4:], rtol=1e-4)
    size = np.sqrt(np.diag(covariance))
    slow, fast = fit.natural
    assert slow.freq_hz == pytest.approx(np.hypot(20, 30) / (2 * np.pi)) and fast.damping == 1.0
    assert fast.freq_error_hz == pytest.approx(size[0] / (2 * np.pi))
    assert slow.freq_error_hz == pytest.approx(np.hypot(20 * size[1], 30 * size[2]) / np.hypot(20, 30) / (2 * np.pi))
    assert fit.known.delay_error_s == pytest.approx(size[-1])
    assert fit.poles_rad_s.tolist() == [-60, -20 + 30j, -20 - 30j] and fit.zeros_rad_s.size == 0


def test_zeros_without_a_rate_are_known_up_to_ten_times_the_highest_frequency():
    table = anti_resonances()
    fit = fit_frequency_response(table.freq_hz, table.true_response, table.order)
    highest = np.abs(fit.known.zeros_rad_s).max()
    for share, kept in ((9.9, True), (10.1, False)):
        top = highest / (2 * np.pi) / share
        known = replace(fit, freq_hz=fit.freq_hz * top / fit.freq_hz[-1]).known
        assert bool(np.isclose(np.abs(known.zeros_rad_s), highest).any()) is kept


@pytest.mark.parametrize("delayed", [True, False])
@pytest.mark.parametrize("proper", [True, False])
def test_errors_of_a_model_with_or_without_direct_term_and_delay_are_those_of_its_numbers(proper, delayed):
    """Two outputs and one drive, a real pole and a pair."""
    draw = np.random.Generator(np.random.Philox(8)).standard_normal
    poles = np.array([-60.0 + 0j, -20 + 30j])
    vectors = np.array([[1.0], [1 + 2j]]), np.array([[30.0, 5 - 2j], [7.0, 1 + 4j]])
    direct = np.zeros((2, 1)) if proper else np.array([[0.5], [1.0]])
    model = ModalModel(poles, *vectors, direct, 0.01 * delayed)
    numbers = pack(model, not proper)
    count = numbers.size + delayed
    root = 1e-3 * draw((count + 4, count)) * np.append(np.maximum(np.abs(numbers), 1.0), 0.1)[:count]
    freq = np.array([0.0, 0.5, 9.0])
    words = {"system": model.state_space(), "modes": model, "order": 3, "hold": "band-limited", "rate_hz": None}
    words |= {"freq_hz": freq, "table": model.response(freq), "scan": (), "reason": "", "normal": None, "variance": 1.0}
    fit = frequency_fit.FrequencyResponseFit(**words, errors_from="", chi_square=None, strictly_proper=proper)
    covariance = root.T @ root
    vars(fit)["covariance"] = covariance
    size = np.sqrt(np.diag(covariance))
    assert fit.known.delay_error_s == pytest.approx(size[-1] if delayed else 0.0)
    pair = np.hypot(size[1], size[2])
    np.testing.assert_allclose(fit.known.poles_error_rad_s, [size[0], pair, pair])

    def gains(v):
        at = 2j * np.pi * np.array([0.0, 0.5])  # at rest, and at the lowest frequency above
        values = transfer_matrix(unpack(v, model), at)[:, :, 0]
        return np.concatenate([values[0].real, np.abs(values[1])])

    jacobian = central_differences(gains, numbers, 1e-6 * np.maximum(np.abs(numbers), 0.01))
    own = covariance[: numbers.size, : numbers.size]
    errors = np.sqrt(np.einsum("ij,jk,ik->i", jacobian, own, jacobian))
    np.testing.assert_allclose(
        np.concatenate([fit.known.dc_gain_error, fit.known.edge_gain_error])[:, 0], errors, rtol=1e-4
    )


@pytest.mark.parametrize("alike", [True, False])
@pytest.mark.parametrize("proper", [True, False])
def test_a_start_whose_sums_are_singular_is_that_of_a_vector_fit_with_the_weight_of_each_element(
    monkeypatch, alike, proper
):
    """A table of two outputs and three drives behind a hold, with errors of its own in each element or a factor."""

    def singular(*args, **words):
        raise np.linalg.LinAlgError("the sums are singular")

    monkeypatch.setattr(frequency_fit, "sketched", singular)
    draw = np.random.Generator(np.random.Philox(3)).standard_normal
    freq = np.arange(1.0, 41.0)
    true = ModalModel(
        np.array([-60.0 + 0j, -20 + 90j]),
        np.array([[1.0, -2.0, 0.5], [1 + 2j, 1.0, -1j]]),
        np.array([[30.0, 5 - 2j], [7.0, 1 + 4j]]),
        np.ones((2, 3)) * (not proper),
    )
    response = true.response(freq, "first-order", 200.0) + 0.03 * (draw((40, 2, 3)) + 1j * draw((40, 2, 3)))
    error = np.exp(draw((1, 2, 3)) + 0.2 * draw((40, 1, 1)) + (not alike) * 0.3 * draw((40, 2, 3)))
    table = response_table.checked(freq, response, error, ("first-order", 200.0, proper))
    equations = table.equations()
    assert (len(equations.squared) == 1) is alike
    found = frequency_fit._sketch(table, equations.response, equations, 3)
    words = {"weight": np.sqrt(2.0) / error, "hold": "first-order", "rate_hz": 200.0, "strictly_proper": proper}
    expected = vector_fit(freq, equations.response, 3, **words)
    np.testing.assert_allclose(found.poles_rad_s, expected.poles_rad_s, rtol=1e-3)  # both end within a millionth
    np.testing.assert_allclose(found.residues, expected.residues, rtol=1e-2, atol=1e-2)
    assert found.rms_error == pytest.approx(expected.rms_error, rel=1e-5) and found.direct.any() == (not proper)


def test_the_largest_of_several_orders_has_to_have_fewer_numbers_than_the_table():
    freq = np.arange(1.0, 11.0)
    with pytest.raises(IdentificationError) as refused:
        fit_frequency_response(freq, 1.0 / (1.0 + 0.3j * freq), [9, 2], delay=True)
    assert str(refused.value) == (
        "a model of order 9 has 20 numbers, and 10 frequencies give 20 real values; give more frequencies or a lower "
        "order."
    )


def limited_table(error):
    """Of 64 rows, a model of order 3 of two outputs and one drive has 11 numbers: 53 are left."""
    return response_table.ResponseTable(
        np.arange(3.0, 19.0), np.ones((16, 2, 1)) + 0j, error, "band-limited", None, True
    )


FREEDOM = 53.0


@pytest.mark.parametrize(
    ("error", "cost", "answers", "kept", "asked"),
    [
        (None, 1e9, ["a"], "own", 0),
        (0.1, FREEDOM + 3.0 * np.sqrt(2.0 * FREEDOM) - 1e-6, ["a"], "own", 0),
        (0.1, FREEDOM + 3.0 * np.sqrt(2.0 * FREEDOM) + 1e-6, [None], "own", 1),
        (0.1, 900.0, ["a", "b", None, "c"], "b", 3),
        (0.1, 900.0, [f"{k}" for k in range(20)], "11", 12),
    ],
)
def test_modes_are_exchanged_as_long_as_that_helps_where_more_is_left_than_the_known_noise(
    monkeypatch, error, cost, answers, kept, asked
):
    heard, left = [], list(answers)
    monkeypatch.setattr(frequency_fit, "exchanged", lambda *given: heard.append(given) or left.pop(0))
    own = polished_of(cost, rows=64, model=SimpleNamespace(order=3))
    found = frequency_fit._Found("equations", own, 2e-3)
    best = frequency_fit._improved(limited_table(error), found)
    assert best == ("equations", own if kept == "own" else kept, 2e-3)
    assert heard == [("equations", now, (3.0, 18.0)) for now in [own, *answers][:asked]]


@pytest.mark.parametrize(
    ("cost", "outputs", "inputs", "order", "other"),
    [
        (601.0, 2, 3, 5, 3),
        (601.0, 3, 2, 2, 1),
        (601.0, 3, 3, 7, 3),
        (599.0, 2, 3, 5, None),
        (601.0, 1, 3, 5, None),
        (601.0, 3, 1, 5, None),
        (601.0, 3, 3, 2, None),
    ],
)
@pytest.mark.parametrize("again", [500.0, 700.0])
def test_a_start_that_lacks_something_has_a_second_one_of_fewer_poles_of_full_rank(
    monkeypatch, cost, outputs, inputs, order, other, again
):
    """The vector fit leaves 2 in each of 100 rows, of half a square each: 1.5 times that is 300, and 600 with 4."""
    sketched_with = []
    equations = SimpleNamespace(response=np.zeros((50, outputs, inputs)), rows=100)

    def sketch(table, response, own, poles):
        assert response is equations.response and own is equations
        sketched_with.append(poles)
        return SimpleNamespace(rms_error=2.0 * np.sqrt(2.0), modes=lambda: ("modes", poles))

    monkeypatch.setattr(frequency_fit, "_sketch", sketch)
    monkeypatch.setattr(frequency_fit, "_start", lambda own, found, poles: ("start", poles))
    monkeypatch.setattr(frequency_fit, "reduced", lambda modes, poles: ("reduced", modes, poles))
    monkeypatch.setattr(frequency_fit, "_fitted_outputs", lambda own, model: (model, 0.0))
    costs = {"start": cost, "reduced": again}
    monkeypatch.setattr(frequency_fit, "_from", lambda own, start: SimpleNamespace(cost=costs[start[0]], start=start))
    best = frequency_fit._polished("table", equations, order)
    if other is None:
        assert sketched_with == [order] and best.start == ("start", order)
    else:
        assert sketched_with == [order, other]
        assert best.start == (("reduced", ("modes", other), order) if again < cost else ("start", order))


def test_the_error_of_the_sketch_counts_each_element_by_its_factor():
    table = three_axes()
    one, size = np.ones((1, table.freq_hz.size)), table.response[0].size
    factors = np.geomspace(0.01, 100.0, size)[:, None]
    found = sketched(table.freq_hz, table.response, one, factors, table.order)
    poles = 2j * np.pi * table.freq_hz[:, None] - found.poles_rad_s
    error = np.einsum("kp,poi->koi", 1.0 / poles, found.residues) + found.direct - table.response
    expected = np.sqrt(np.sum(factors[:, 0] * np.abs(error.reshape(-1, size)) ** 2) / error.size)
    assert found.rms_error == pytest.approx(expected, rel=1e-6)
