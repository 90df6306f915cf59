"""State-space algebra against exact rational arithmetic, scipy and python-control."""

from fractions import Fraction
from itertools import pairwise
from math import pi

import control
import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.linalg import block_diag, expm, solve_discrete_are, solve_discrete_lyapunov
from scipy.signal import cont2discrete, dlsim, lsim

from microrad.core import lti
from microrad.core.kernels import doubling

NUMERATOR = (1.979e11, 7.051e13, 2.973e13)  # Eq. 2 of the paper, powers of s in rad/s
DENOMINATOR = (1.0, 2.15e4, 3.737e8, 2.615e12, 8.489e14, 1.829e14)
STEP = 20e-6


def exact_polynomial(coefficients, w):
    """(real, imaginary) part at s = i w, all rational."""
    real, imaginary = Fraction(0), Fraction(0)
    for c in coefficients:  # Horner: (re + i im) i w + c
        real, imaginary = -imaginary * w + Fraction(c), real * w
    return real, imaginary


def exact_response(freq_hz):
    """Eq. 2 at i w without rounding, but for the last conversion; w is the double nearest 2 pi f."""
    w = Fraction(float(2 * np.pi * freq_hz))
    a, b = exact_polynomial(NUMERATOR, w)
    c, d = exact_polynomial(DENOMINATOR, w)
    size = c * c + d * d
    return complex(float((a * c + b * d) / size), float((b * c - a * d) / size))


@pytest.mark.parametrize("freq_hz", [0, 1e-3, 0.0343, 0.0672, 1, 2, 15, 54.22, 56.64, 100, 1000, 1552.7, 2542.7, 5000])
def test_the_modal_form_is_eq_2(freq_hz):
    system = lti.modal_from_polynomials(NUMERATOR, DENOMINATOR)
    response = lti.frequency_response(system, np.array([freq_hz]))[0, 0, 0]
    expected = exact_response(freq_hz)
    error = abs(response - expected) / abs(expected)
    print(f"{freq_hz:g} Hz: relative error {error:.1e}")
    assert error < 1e-13


def test_the_modal_form_is_block_diagonal():
    A = lti.modal_from_polynomials(NUMERATOR, DENOMINATOR).A
    sizes = [2, 1, 1, 1]  # fastest first: the complex pair, then three real poles
    mask = block_diag(*(np.ones((n, n)) for n in sizes)).astype(bool)
    assert np.all(A[~mask] == 0.0)
    assert np.all(A[mask] != 0.0)
    assert A[0, 1] == -A[1, 0]


def test_poles_and_zeros_of_eq_2():
    poles = np.linalg.eigvals(lti.modal_from_polynomials(NUMERATOR, DENOMINATOR).A)
    found = sorted((abs(p) / (2 * pi), -p.real / abs(p)) for p in poles if p.imag >= 0)
    expected = [(0.0343, 1.0), (54.22, 1.0), (1552.7, 1.0), (2542.7, 0.357)]
    for (freq_hz, damping), (expected_hz, expected_damping) in zip(found, expected, strict=True):
        assert_allclose(freq_hz, expected_hz, rtol=5e-4)
        assert_allclose(damping, expected_damping, rtol=2e-3)


@pytest.mark.parametrize("zero_hz", [0.0672, 56.64])
def test_the_response_vanishes_at_the_zeros(zero_hz):
    """The zeros are real: at s = -2 pi f the response passes through nought, within the printed digits."""
    system = lti.modal_from_polynomials(NUMERATOR, DENOMINATOR)

    def on_the_real_axis(freq_hz):
        resolvent = -2 * pi * freq_hz * np.eye(system.order) - system.A
        return (system.C @ np.linalg.solve(resolvent, system.B))[0, 0]

    assert on_the_real_axis(zero_hz * 0.999) * on_the_real_axis(zero_hz * 1.001) < 0


def test_gains_of_eq_2():
    system = lti.modal_from_polynomials(NUMERATOR, DENOMINATOR)
    assert_allclose(abs(lti.frequency_response(system, np.zeros(1))), 0.16255, atol=5e-6)
    band = np.abs(lti.frequency_response(system, np.geomspace(1, 100, 200)))[:, 0, 0]
    assert_allclose([band.max(), band.min()], [0.08315, 0.08022], atol=5e-6)
    assert np.all(np.diff(band) < 0)


# ------------------------------------------------------------------------------------------------ holds


def make_system(seed, states=3, inputs=2, outputs=2):
    """A stable system with a fast oscillating pair and a slow pole, and a direct path."""
    rng = np.random.default_rng(seed)
    w, damping = 2 * pi * 1300, 0.2
    pair = w * np.array([[-damping, 1.0], [-1.0, -damping]])
    A = block_diag(pair, -2 * pi * 5.0 * np.eye(states - 2))
    turn = rng.normal(size=(states, states))
    A = np.linalg.solve(turn, A @ turn)
    return lti.StateSpace(
        A,
        rng.normal(size=(states, inputs)) * w,
        rng.normal(size=(outputs, states)),
        rng.normal(size=(outputs, inputs)),
    )


def ramps(seed, samples=120, inputs=2):
    """Inputs that begin at zero, linear between samples."""
    u = np.random.default_rng(seed).normal(size=(samples, inputs))
    u[0] = 0.0
    return u


def first_order_response(system, u, step_s):
    Ad, B0, B1 = lti.first_order_hold(system.A, system.B, step_s)
    x, y = np.zeros(system.order), [system.D @ u[0]]
    for start, end in pairwise(u):
        x = Ad @ x + B0 @ start + B1 @ end
        y.append(system.C @ x + system.D @ end)
    return np.array(y)


@pytest.mark.parametrize("step_s", [STEP, 4e-4])
def test_first_order_hold_against_scipy_and_python_control(step_s):
    """The three name their states differently, so the responses to an input of ramps are compared."""
    system, u = make_system(5), ramps(6)
    ours = first_order_response(system, u, step_s)
    time = step_s * np.arange(len(u))
    matrices = (system.A, system.B, system.C, system.D)
    discrete = cont2discrete(matrices, step_s, method="foh")
    by_matrices = dlsim(discrete, u)[1]
    by_lsim = lsim(matrices, u, time, interp=True)[1]
    by_control = control.forced_response(control.ss(*matrices), time, u.T).outputs.T
    size = np.max(np.abs(ours))
    for theirs in (by_matrices, by_lsim, by_control):
        assert_allclose(ours, theirs, rtol=0, atol=1e-10 * size)
    held = lsim(matrices, u, time, interp=False)[1]
    assert np.max(np.abs(ours - held)) > 1e-3 * size


@pytest.mark.parametrize("step_s", [STEP, 4e-4])
def test_zero_order_hold_against_scipy_and_python_control(step_s):
    system = make_system(7)
    Ad, Bd = lti.zero_order_hold(system.A, system.B, step_s)
    expected = cont2discrete((system.A, system.B, system.C, system.D), step_s, method="zoh")
    theirs = control.sample_system(control.ss(system.A, system.B, system.C, system.D), step_s, method="zoh")
    for A, B in (expected[:2], (theirs.A, theirs.B)):
        assert_allclose(Ad, A, rtol=0, atol=1e-12 * np.max(np.abs(A)))
        assert_allclose(Bd, B, rtol=0, atol=1e-12 * np.max(np.abs(B)))


def test_the_holds_of_an_integrator_by_hand():
    Ad, B0, B1 = lti.first_order_hold(np.zeros((1, 1)), np.ones((1, 1)), 0.5)
    assert_allclose([Ad[0, 0], B0[0, 0], B1[0, 0]], [1.0, 0.25, 0.25], rtol=1e-15)
    assert_allclose(lti.zero_order_hold(np.zeros((1, 1)), np.ones((1, 1)), 0.5)[1], 0.5, rtol=1e-15)


# ------------------------------------------------------------------------------------------------ responses and algebra


@pytest.mark.parametrize("step_s", [None, 1e-4], ids=["continuous", "discrete"])
def test_frequency_response_against_python_control(step_s):
    system = make_system(8)
    if step_s is not None:
        Ad, Bd = lti.zero_order_hold(system.A, system.B, step_s)
        system = lti.StateSpace(Ad, Bd, system.C, system.D)
    theirs = control.ss(system.A, system.B, system.C, system.D, 0 if step_s is None else step_s)
    freq_hz = np.geomspace(0.1, 4900, 40)
    s = 2j * pi * freq_hz
    expected = np.moveaxis(theirs(s if step_s is None else np.exp(s * step_s)), 2, 0)
    ours = lti.frequency_response(system, freq_hz, step_s)
    assert ours.shape == (40, 2, 2)
    assert_allclose(ours, expected, rtol=0, atol=1e-11 * np.max(np.abs(expected)))


def test_a_system_without_states_responds_with_its_direct_path():
    gain = lti.StateSpace(np.zeros((0, 0)), np.zeros((0, 2)), np.zeros((1, 0)), np.array([[2.0, -3.0]]))
    assert_allclose(lti.frequency_response(gain, np.array([1.0, 10.0])), np.full((2, 1, 2), [2.0, -3.0]))


def test_series_against_python_control():
    first, second = make_system(9, inputs=1, outputs=2), make_system(10, states=4, inputs=2, outputs=3)
    ours = lti.series(first, second)
    theirs = control.series(*(control.ss(s.A, s.B, s.C, s.D) for s in (first, second)))
    assert ours.order == 7
    freq_hz = np.geomspace(1, 5000, 20)
    expected = np.moveaxis(theirs(2j * pi * freq_hz, squeeze=False), 2, 0)
    assert_allclose(lti.frequency_response(ours, freq_hz), expected, rtol=0, atol=1e-10 * np.max(np.abs(expected)))


@pytest.mark.parametrize("seed", [11, 12])
def test_feedback_poles_against_python_control(seed):
    system = make_system(seed)
    closed = control.feedback(control.ss(system.A, system.B, system.C, system.D), np.eye(2))
    ours, theirs = (np.sort_complex(p) for p in (lti.feedback_poles(system), closed.poles()))
    assert_allclose(ours, theirs, rtol=1e-9)
    assert np.max(np.abs(ours - np.sort_complex(np.linalg.eigvals(system.A)))) > 1.0


# ------------------------------------------------------------------------------------------------ refusals


@pytest.mark.parametrize(
    "poles",
    [
        (-1000.0, -1000.0),
        (-1000.0, -1000.0, -5.0),
        (0.0, 0.0, -5.0),
        (-100 + 900j, -100 + 900j, -100 - 900j, -100 - 900j),
    ],
    ids=["double", "double and single", "double integrator", "double pair"],
)
def test_repeated_poles_are_refused(poles):
    with pytest.raises(ValueError, match="two poles coincide"):
        lti.modal_from_polynomials((1.0,), tuple(np.poly(poles).real))


@pytest.mark.parametrize("order", [3, 5])
def test_poles_repeated_more_often_are_refused(order):
    with pytest.raises(ValueError, match="coincide"):
        lti.modal_from_polynomials((1.0,), tuple(np.poly([-1000.0] * order)))


@pytest.mark.parametrize("distance", [1e-2, 1e-4])
def test_close_poles_are_taken_apart(distance):
    a, b = 1000.0, 1000.0 * (1 + distance)
    system = lti.modal_from_polynomials((a * b,), (1.0, a + b, a * b))
    freq_hz = np.array([0.0, 10.0, 159.0, 1000.0])
    s = 2j * pi * freq_hz
    assert_allclose(lti.frequency_response(system, freq_hz)[:, 0, 0], a * b / ((s + a) * (s + b)), rtol=1e-6)


@pytest.mark.parametrize(
    ("numerator", "denominator", "orders"),
    [((1.0, 2.0), (1.0, 3.0), (1, 1)), ((1.0, 0.0, 2.0), (1.0, 3.0), (2, 1)), ((5.0,), (0.0, 3.0), (0, 0))],
)
def test_improper_fractions_are_refused(numerator, denominator, orders):
    message = f"numerator of order {orders[0]} over denominator of order {orders[1]}: not strictly proper"
    with pytest.raises(ValueError, match=message):
        lti.modal_from_polynomials(numerator, denominator)


def test_leading_zeros_do_not_count():
    padded = lti.modal_from_polynomials((0.0, 0.0, 4.0), (0.0, 2.0, 6.0))
    assert padded.order == 1
    assert_allclose(lti.frequency_response(padded, np.zeros(1)), 4.0 / 6.0, rtol=1e-15)


def test_a_highest_power_that_is_nothing_beside_the_others_is_refused():
    with pytest.raises(ValueError, match="the highest power of s has a coefficient of 1e-151, which is nothing beside"):
        lti.modal_from_polynomials((1.0,), (1e-151, 1.0))
    system = lti.modal_from_polynomials((1.0,), (2e-150, 1.0))
    assert_allclose(lti.frequency_response(system, np.zeros(1)), 1.0, rtol=1e-15)


# ------------------------------------------------------------------------------------------------- roots in, roots out
def test_a_modal_form_from_roots_is_the_product_over_them_with_unit_magnitude_where_it_is_asked():
    zeros, poles = (np.roots(each).astype(complex) for each in (NUMERATOR, DENOMINATOR))
    system = lti.modal_from_roots(zeros, poles, 2.0)
    assert_allclose(np.sort_complex(np.linalg.eigvals(system.A)), np.sort_complex(poles), rtol=1e-10)
    here = lti.frequency_response(system, np.array([2.0]))[0, 0, 0]
    assert abs(here) == pytest.approx(1.0, rel=1e-12)
    assert here.real > 0.0
    for freq_hz in (0.01, 54.0, 2543.0, 1e4):
        ratio = lti.frequency_response(system, np.array([freq_hz]))[0, 0, 0] / here
        expected = exact_response(freq_hz) / exact_response(2.0)
        assert ratio == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize(
    ("zeros", "poles", "words"),
    [
        ([-1.0], [-2.0], "1 zero over 1 pole: not strictly proper"),
        ([], [-2.0, -2.0], "two poles coincide"),
        ([2j * pi, -2j * pi], [-1.0, -2.0, -3.0], "vanishes at 1 Hz"),
    ],
)
def test_roots_without_a_modal_form_are_refused(zeros, poles, words):
    with pytest.raises(ValueError, match=words):
        lti.modal_from_roots(np.array(zeros, dtype=complex), np.array(poles, dtype=complex), 1.0)


def test_a_single_pole_has_a_modal_form():
    system = lti.modal_from_roots(np.zeros(0, dtype=complex), np.array([-2.0 * pi], dtype=complex), 1.0)
    freq_hz = np.array([0.0, 1.0, 10.0])
    wanted = np.sqrt(2.0 / (1.0 + freq_hz**2))
    assert_allclose(np.abs(lti.frequency_response(system, freq_hz)[:, 0, 0]), wanted, rtol=1e-12)


def by_size(roots):
    """Roots in an order that rounding does not change: by real part to eight digits, then by imaginary part."""
    return np.array(sorted(roots, key=lambda root: (float(f"{root.real:.7e}"), root.imag)))


def test_zeros_of_a_system_are_where_python_control_finds_them():
    system = lti.modal_from_polynomials(NUMERATOR, DENOMINATOR)
    found = np.sort_complex(lti.zeros(system))
    assert_allclose(found[np.abs(found) < 1e6], np.sort_complex(np.roots(NUMERATOR)), rtol=1e-7)
    rng = np.random.default_rng(3)
    square = lti.StateSpace(
        rng.standard_normal((4, 4)),
        rng.standard_normal((4, 2)),
        rng.standard_normal((2, 4)),
        rng.standard_normal((2, 2)),
    )
    expected = control.zeros(control.ss(square.A, square.B, square.C, square.D))
    assert_allclose(by_size(lti.zeros(square)), by_size(expected), rtol=1e-8)
    assert lti.zeros(square).size == 4


def test_rows_of_a_resolvent_are_those_of_a_solution_at_each_point():
    """Several systems, one of them with states of sizes that differ by nine decades, one with modes that coincide."""
    rng = np.random.default_rng(8)
    A = 0.4 * rng.standard_normal((3, 4, 4))
    size = np.array([1.0, 1e-9, 1e3, 1.0])
    A[1] = A[1] * size[:, None] / size
    A[2] = 0.5 * np.eye(4) + np.diag(np.ones(3), 1)
    C, points = rng.standard_normal((3, 2, 4)), np.exp(1j * np.array([0.01, 0.3, 1.5, np.pi]))
    C[1] = C[1] / size
    found = lti.resolvent_rows(A, C, points)
    assert found.shape == (3, 2, 4, 4)
    for i, k in np.ndindex(3, 4):
        expected = C[i] @ np.linalg.inv(points[k] * np.eye(4) - A[i])
        assert_allclose(found[i, :, :, k], expected, rtol=1e-10, atol=1e-14 * np.max(np.abs(expected)))


# ------------------------------------------------------------------------------------------------- covariances
def test_a_gramian_sees_what_is_observed_only_after_many_samples():
    n = 20
    A = np.diag(np.ones(n - 1), -1) * 1.5 + 0.3 * np.eye(n)
    Q = np.zeros((n, n))
    Q[0, 0], Q[-1, -1] = 1.0, 1e-3
    expected = solve_discrete_lyapunov(A.T, Q)
    assert_allclose(lti.gramian(A, Q), expected, rtol=1e-9, atol=1e-9 * np.max(expected))


def test_a_gramian_ends_where_rounding_left_a_variance_below_zero_beside_a_state_that_turns_for_ever():
    """A turn that is longer than 1 by rounding overflows when it is taken 2^64 times."""
    turn = np.array([[np.cos(0.3), np.sin(0.3)], [-np.sin(0.3), np.cos(0.3)]]) * (1 + 1e-15)
    A, Q = block_diag(0.5, 0.2, turn), np.diag([1.0, -1e-31, 0.0, 0.0])
    assert_allclose(np.diag(lti.gramian(A, Q)), [4 / 3, -1e-31 / 0.96, 0.0, 0.0], rtol=1e-12)


def test_a_gramian_of_a_stack_is_that_of_each_and_of_the_transpose_a_covariance():
    rng = np.random.default_rng(5)
    A = 0.3 * rng.standard_normal((5, 5))
    A *= 0.999 / np.max(np.abs(np.linalg.eigvals(A)))
    roots = rng.standard_normal((3, 5, 2))
    noises = roots @ np.swapaxes(roots, 1, 2)
    found = lti.gramian(A.T, noises)
    assert found.shape == (3, 5, 5)
    for X, noise in zip(found, noises, strict=True):
        assert_allclose(X, A @ X @ A.T + noise, rtol=1e-10, atol=1e-10 * np.max(X))
        assert_allclose(X, lti.gramian(A.T, noise), rtol=1e-12)
    nothing = np.zeros((0, 0))
    assert lti.gramian(nothing, nothing).shape == (0, 0)


@pytest.mark.parametrize(
    ("matrix", "root"),
    [
        ([[4.0, 2.0], [2.0, 5.0]], [[2.0, 0.0], [1.0, 2.0]]),
        ([[1.0, 1.0], [1.0, 1.0]], [[1.0, 0.0], [1.0, 0.0]]),  # the second adds nothing
        ([[1.0, 1.0], [1.0, 1.0 + 4e-13]], [[1.0, 0.0], [1.0, 0.0]]),  # nor by what rounding may leave
        ([[1.0, 1.0], [1.0, 1.0 + 4e-6]], [[1.0, 0.0], [1.0, 2e-3]]),
        ([[0.0, 0.0], [0.0, 9.0]], [[0.0, 0.0], [0.0, 3.0]]),
        ([[1e-20, 0.0], [0.0, 1e20]], [[1e-10, 0.0], [0.0, 1e10]]),  # small states keep their digits
    ],
)
def test_the_root_of_a_covariance_is_lower_triangular_and_0_where_a_state_adds_nothing(matrix, root):
    assert_allclose(lti.covariance_root(np.array(matrix)), root, rtol=1e-6, atol=1e-15)


@pytest.mark.parametrize(
    ("covariance", "variances", "axes"),
    [
        ([[2.0, 0.0], [0.0, 1.0]], [1.0, 2.0], [[0.0, 1.0], [1.0, 0.0]]),
        ([[2.0, 1e-10], [1e-10, 2.0]], [2.0, 2.0], [[1.0, 0.0], [0.0, 1.0]]),  # as good as uncorrelated and equal
        ([[0.0, 0.0], [0.0, 0.0]], [0.0, 0.0], [[1.0, 0.0], [0.0, 1.0]]),
        ([[2.0, 1.0], [1.0, 2.0]], [1.0, 3.0], [[0.5**0.5, 0.5**0.5], [-(0.5**0.5), 0.5**0.5]]),
        ([[2.0, -1.0], [-1.0, 2.0]], [1.0, 3.0], [[0.5**0.5, 0.5**0.5], [0.5**0.5, -(0.5**0.5)]]),
    ],
)
def test_principal_axes_point_to_where_their_largest_entry_is_above_0(covariance, variances, axes):
    found, directions = lti.principal_axes(np.array(covariance))
    assert_allclose(found, variances, rtol=1e-9, atol=1e-15)
    assert_allclose(directions, axes, rtol=1e-6, atol=1e-15)


@pytest.mark.parametrize(
    ("call", "error", "words"),
    [
        (
            lambda: lti.modal_from_polynomials((1.0, 2.0, 3.0), (0.0, 4.0, 5.0, 6.0)),
            ValueError,
            "numerator of order 2 over denominator of order 2: not strictly proper",
        ),
        (
            lambda: lti.modal_from_polynomials((1.0,), (2.5e-151, 1.0, 3.0)),
            ValueError,
            "the highest power of s has a coefficient of 2.5e-151, which is nothing beside the others",
        ),
        (
            lambda: lti.modal_from_polynomials((1.0,), (1.0, 6.0, 9.0)),
            ValueError,
            "two poles coincide: the transfer function has no modal form",
        ),
        (
            lambda: lti.modal_from_polynomials(
                (1.0,), tuple(np.poly([-7.0, -7.0 * (1.0 + 2e-5), -7.0 * (1.0 - 2e-5), -9.0]))
            ),
            ValueError,
            "poles nearly coincide: the transfer function has no accurate modal form",
        ),
        (
            lambda: lti.modal_from_roots(
                np.array([-1.0, -3.0], dtype=complex), np.array([-2.0, -4.0], dtype=complex), 1.5
            ),
            ValueError,
            "2 zeros over 2 poles: not strictly proper",
        ),
        (
            lambda: lti.modal_from_roots(
                np.array([3j * pi, -3j * pi]), np.array([-1.0, -2.0, -5.0], dtype=complex), 1.5
            ),
            ValueError,
            "the transfer function vanishes at 1.5 Hz and cannot be divided by its gain there",
        ),
    ],
)
def test_a_refusal_of_a_transfer_function_says_its_orders(call, error, words):
    with pytest.raises(error) as refused:
        call()
    assert str(refused.value) == words


BIQUAD = lti.modal_from_polynomials((3.0, 70.0), (2.0, 31.0, 470.0, 900.0))
FROM_ROOTS = lti.modal_from_roots(np.array([-4.0 + 7.0j, -4.0 - 7.0j]), np.array([-2.0, -9.0 + 3.0j, -9.0 - 3.0j]), 0.8)


@pytest.mark.parametrize(("found", "expected"), [
    (lambda: [x for each in lti.frequency_response(BIQUAD, np.array([0.0, 0.3, 2.5]))[:, 0,
            0] for x in (each.real, each.imag)],
     [0.0777777778, 0.0, 0.0434770946, -0.0408687491, -0.0107215585, -0.00639648208]),
    (lambda: [x for each in lti.frequency_response(FROM_ROOTS, np.array([0.1, 0.8, 2.5]))[:, 0,
            0] for x in (each.real, each.imag)],
     [3.4198798, -1.25728111, 0.218524496, -0.975831463, 0.25424272, -0.38277815]),
    (lambda: [x for each in lti.zero_order_hold(BIQUAD.A, BIQUAD.B,
            0.03) for x in np.linalg.svd(each)[1]],
     [0.936537703, 0.818962281, 0.818962281, 0.039671202]),
    (lambda: [*lti.modal_matrix([(-2.0, 0.0), (-1.0, 5.0), (-3.0, 0.0)]).ravel()],
     [-2.0, 0.0, 0.0, 0.0, 0.0, -1.0, -5.0, 0.0, 0.0, 5.0, -1.0, 0.0, 0.0, 0.0, 0.0, -3.0]),
    (lambda: [*lti.principal_axes(np.array([[4.0, 0.0, 0.0], [0.0, 1.5, 0.0], [0.0, 0.0, 2.25]]))[0],
            *lti.principal_axes(np.array([[4.0, 0.0, 0.0], [0.0, 1.5, 0.0], [0.0, 0.0,
            2.25]]))[1].ravel()],
     [1.5, 2.25, 4.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0]),
    (lambda: [x for each in lti.principal_axes(np.array([[4.0, 1.1], [1.1,
            2.25]])) for x in each.ravel()],
     [1.71943072, 4.53056928, -0.434440119, 0.900700718, 0.900700718, 0.434440119]),
    (lambda: [*lti.covariance_root(np.array([[4.0, 1.1, -0.4], [1.1, 2.25, 0.7], [-0.4, 0.7,
            3.0]])).ravel()],
     [2.0, 0.0, 0.0, 0.55, 1.39552857, 0.0, -0.2, 0.580425235, 1.61960074]),
    (lambda: [float(x) for x in lti.to_bits(np.array([0.7123456789, -3.3e-7]),
            12)] + [float(x) for x in lti.decay_to_bits(np.array([0.99871234]), 12)],
     [0.712402344, -3.30037437e-07, 0.99871254]),
    (lambda: [*lti.sliding_cases(2).ravel(), *lti.sliding_cases(7).ravel()],
     [
        0.0, 0.0, 0.0, 1.0, 1.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0,
        1.0,
    ]),
])  # fmt: skip
def test_systems_of_numbers_unlike_each_other(found, expected):
    assert list(found()) == pytest.approx(expected, rel=1e-6, abs=0.0, nan_ok=True)


# ------------------------------------------------------------------------------------- orders, signs and shapes unlike
def test_modes_stand_by_the_size_of_their_poles_whatever_their_order_and_pairs_by_the_upper_one():
    poles = np.array([-2.0, -3.0 - 40.0j, -700.0, -9.0 + 5.0j, -3.0 + 40.0j, -9.0 - 5.0j], dtype=complex)
    residues = np.array([1.5, 2.0 - 7.0j, -4.0, 0.3 + 0.8j, 2.0 + 7.0j, 0.3 - 0.8j])
    found = lti.modal_from_residues(poles, residues)
    expected = block_diag(-700.0, [[-3.0, 40.0], [-40.0, -3.0]], [[-9.0, 5.0], [-5.0, -9.0]], -2.0)
    assert_allclose(found.A, expected)
    assert_allclose(found.B[:, 0], [1, 1, 0, 1, 0, 1])
    assert_allclose(found.C[0], [-4.0, 4.0, 14.0, 0.6, 1.6, 1.5])
    s = 2j * pi * np.array([0.2, 6.0])
    assert_allclose(lti.frequency_response(found, s.imag / 2 / pi)[:, 0, 0], np.sum(residues / (s[:, None] - poles), 1))


@pytest.mark.parametrize(
    ("numerator", "denominator"),
    [((-3.0, 5.0), (-2.0, -8.0, -30.0)), ((4.0,), (1.0, 5.0, 6.0, 0.0)), ((0.0, 7.0, 0.0), (3.0, 4.0, 9.0))],
    ids=["signs", "integrator", "zero at rest"],
)
def test_a_modal_form_is_its_polynomials(numerator, denominator):
    freq, system = np.array([0.05, 0.6, 4.0]), lti.modal_from_polynomials(numerator, denominator)
    s = 2j * pi * freq
    assert_allclose(
        lti.frequency_response(system, freq)[:, 0, 0], np.polyval(numerator, s) / np.polyval(denominator, s)
    )


@pytest.mark.parametrize(("zero", "at_hz"), [(6.0, 0.1), (-6.0, 0.1), (-0.5, 3.0), (0.5, 3.0)])
def test_a_form_from_roots_is_turned_to_where_its_real_part_is_positive_at_its_frequency(zero, at_hz):
    poles = np.array([-1.0, -4.0 + 9.0j, -4.0 - 9.0j])
    system = lti.modal_from_roots(np.array([zero], dtype=complex), poles, at_hz)
    s, at = 2j * pi * np.array([0.3, 2.2]), 2j * pi * at_hz
    plain, there = ((x - zero) / np.prod(x - poles) for x in (s[:, None], at))
    plain = (s - zero) / np.prod(s[:, None] - poles, axis=1)
    expected = plain * np.copysign(1.0, there.real) / abs(there)
    assert_allclose(lti.frequency_response(system, s.imag / 2 / pi)[:, 0, 0], expected, rtol=1e-10)


def test_a_hold_of_a_stack_of_systems_with_more_inputs_than_states_is_that_of_each():
    rng = np.random.default_rng(2)
    A, B = rng.standard_normal((3, 2, 2)) - 2 * np.eye(2), rng.standard_normal((3, 2, 5))
    found = lti.first_order_hold(A, B, 0.3)
    assert [each.shape for each in found] == [(3, 2, 2), (3, 2, 5), (3, 2, 5)]
    for i in range(3):
        Ad, inverse = expm(A[i] * 0.3), np.linalg.inv(A[i])
        held = inverse @ (Ad - np.eye(2)) @ B[i]
        ramp = inverse @ (held / 0.3 - B[i])
        for got, expected in zip((each[i] for each in found), (Ad, held - ramp, ramp), strict=True):
            assert_allclose(got, expected, rtol=1e-11, atol=1e-12)


def test_a_response_at_one_frequency_of_more_outputs_than_inputs_has_its_direct_path():
    one = lti.StateSpace(np.array([[0.5]]), np.array([[2.0, -1.0]]), np.array([[1.0], [3.0], [7.0]]), np.ones((3, 2)))
    z = np.exp(2j * pi * 40.0 * 2e-3)
    for step, point in ((2e-3, z), (None, 2j * pi * 40.0)):
        found = lti.frequency_response(one, np.float64(40.0), step)
        assert found.shape == (1, 3, 2)
        assert_allclose(found[0], one.C @ one.B / (point - 0.5) + 1.0, rtol=1e-13)


@pytest.mark.parametrize(("elements", "cases"), [(0, 1), (1, 2), (3, 8), (6, 64), (7, 2), (9, 2)])
def test_all_combinations_of_up_to_six_elements_slide_and_beyond_all_or_none(elements, cases):
    found = lti.sliding_cases(elements)
    assert found.shape == (cases, elements)
    if elements <= 6:
        assert_allclose(found @ 2.0 ** np.arange(elements)[::-1], np.arange(cases))
    else:
        assert found.tolist() == [[0.0] * elements, [1.0] * elements]


def test_growth_is_that_of_the_worst_combination_which_may_be_one_element_alone():
    A, E, F = np.diag([-1.0, -2.0]), np.array([[1.0, 0.0], [0.0, 1.0]]), np.array([[1.0, 0.0], [0.0, 1.0]])
    found = [lti.growth_1_s(A, E, F, np.array(gains)) for gains in ([3.0, -9.0], [-9.0, 7.0], [-1.0, -1.0])]
    assert_allclose(found, [2.0, 5.0, -1.0])


def test_a_reduced_system_keeps_its_slow_gain_and_stays_within_its_bound_with_two_inputs_and_three_outputs():
    poles = np.array([0.95, 0.6, -0.3, 0.1, 0.05])
    rng = np.random.default_rng(7)
    B, C, D = rng.standard_normal((5, 2)), rng.standard_normal((3, 5)), rng.standard_normal((3, 2))
    system, freq = lti.StateSpace(np.diag(poles), B, C, D), np.linspace(0.0, 0.5, 200)
    P, Q = solve_discrete_lyapunov(system.A, B @ B.T), solve_discrete_lyapunov(system.A.T, C.T @ C)
    hankel = np.sort(np.sqrt(np.linalg.eigvals(P @ Q).real))[::-1]
    for error in (1e-9, 0.3, 3.0, 12.0, 1e4):
        small = lti.reduced(system, error)
        off = lti.frequency_response(small, freq, 1.0) - lti.frequency_response(system, freq, 1.0)
        assert_allclose(off[0], 0.0, atol=1e-9 * np.max(np.abs(C)))
        assert np.max(np.linalg.norm(off, 2, axis=(1, 2))) <= error + 1e-9
        assert small.order == next(n for n in range(6) if 2.0 * np.sum(hankel[n:]) <= error)


@pytest.mark.parametrize(
    ("value", "bits", "rounded"),
    [
        (-0.7, 3, -0.75), (5.3, 4, 5.5), (0.0, 5, 0.0), (1023.9, 2, 1024.0), (-3e-9, 1, -(2.0**-28)),
        (2.0**-1060, 8, 2.0**-1060),
    ],
)  # fmt: skip
def test_a_number_is_rounded_to_bits_about_its_own_size(value, bits, rounded):
    assert lti.to_bits(np.array([[value]]), bits).tolist() == [[rounded]]
    matrices = [np.full((2, 2), value), np.full((2, 1), -value), np.full((1, 2), 3 * value), np.full((1, 1), value)]
    found = lti.system_to_bits(lti.StateSpace(*matrices), bits)
    for key, matrix in zip("ABCD", matrices, strict=True):
        assert_allclose(getattr(found, key), lti.to_bits(matrix, bits), rtol=0.0)


def test_a_slow_state_loses_as_much_in_a_step_as_before_down_to_a_part_in_2_to_the_44():
    lost = np.array([3e-9, 0.3, 1.7, 2.0**-46, 2.0**-44])
    found = 1.0 - lti.decay_to_bits(1.0 - lost, 20)
    assert_allclose(found[:3], lost[:3], rtol=2e-5)
    assert found[3:].tolist() == [0.0, 2.0**-44] and found[1] != lost[1]


@pytest.mark.parametrize(
    ("diagonal", "order"), [([3.0, 1.0, 2.0, 1.0 + 1e-11], [1, 3, 2, 0]), ([5.0, 5.0 - 1e-11, 0.0], [2, 0, 1])]
)
def test_axes_of_uncorrelated_states_are_the_states_and_those_of_one_size_in_their_order(diagonal, order):
    matrix = np.diag(diagonal)
    matrix[0, 1] = matrix[1, 0] = 1e-10
    found, axes = lti.principal_axes(matrix)
    assert_allclose(found, np.array(diagonal)[order], rtol=0.0)
    assert_allclose(axes, np.eye(len(order))[:, order], rtol=0.0)


def test_the_root_of_a_covariance_keeps_the_states_behind_one_that_adds_nothing():
    root = np.array([[2.0, 0, 0, 0], [1.0, 0, 0, 0], [-3.0, 0, 4.0, 0], [0.5, 0, -1.0, 7.0]])
    size = np.array([1.0, 1e5, 1e-8, 3.0])[:, None]
    assert_allclose(lti.covariance_root((size * root) @ (size * root).T), size * root, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("seed", [1, 2])
def test_doubling_ends_at_the_solutions_that_scipy_finds_with_pivots_of_any_order(seed):
    rng = np.random.default_rng(seed)
    A, B, Q = rng.standard_normal((4, 4)), rng.standard_normal((4, 2)), np.diag([1.0, 0.0, 3.0, 0.2])
    weight = np.diag([0.3, 2.0])
    expected, X = solve_discrete_are(A, B, Q, weight), Q.copy()
    G = B @ np.linalg.inv(weight) @ B.T
    assert doubling.riccati_kernel.py_func(A.copy(), G, X, np.empty((4, 4, 4)), np.empty((4, 8)))
    assert_allclose(X, expected, rtol=1e-8, atol=1e-9 * np.max(expected))
    stable, X = 0.9 * A / np.max(np.abs(np.linalg.eigvals(A))), Q + 0.1
    doubling.gramian_kernel.py_func(stable.copy(), X, np.empty((3, 4, 4)))
    assert_allclose(X, solve_discrete_lyapunov(stable.T, Q + 0.1), rtol=1e-9, atol=1e-9)
    matrix, right = rng.standard_normal((5, 5)), rng.standard_normal((5, 3))
    matrix[0, 0] = matrix[2, 1] = matrix[3, 3] = 0.0
    wanted = np.linalg.solve(matrix, right)
    doubling._eliminate.py_func(matrix, right)
    assert_allclose(right, wanted, rtol=1e-9)
    small, product = 1e-13 * matrix, np.empty((5, 3))  # as squared microradians are
    for each in (doubling._product, doubling._product.py_func):
        each(small, right, product)
        assert_allclose(product, small @ right, rtol=1e-12, atol=1e-27)


def test_a_plant_that_no_input_holds_has_no_solution_of_its_riccati_equation():
    work = np.empty((4, 2, 2)), np.empty((2, 4))
    lone, G = np.diag([0.5, 1.25]), np.diag([1.0, 0.0])
    assert not doubling.riccati_kernel.py_func(lone.copy(), G.copy(), np.eye(2), *work)
    assert doubling.riccati_kernel.py_func(lone[::-1, ::-1] / 2, G.copy(), np.eye(2), *work)
