"""LQG against scalar Riccati equations by hand, scipy's solvers, the separation principle and clipped simulation."""

import math
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.linalg import block_diag, solve_discrete_are, solve_discrete_lyapunov

from design_plants import axis_plant
from microrad.core import kernels, lti
from microrad.loop.control import analysis, lqg
from microrad.loop.control.lqg import LQG, LQG_OF_AXES, Weights
from microrad.loop.control.problem import GAUGE, OPTICAL, RESIDUAL, AxisController, WholePlant, once_per_plant

PERIOD = 2e-4
near = partial(pytest.approx, abs=0.0, rel=1e-6)  # variances are far below the default of 1e-12
EXACT = Weights(command=1e-9, sensor_noise=1.0, command_noise_v=0.0, walk=0.0)
PLAIN = Weights(command=1e-2, sensor_noise=1.0, command_noise_v=1e-3)
FULL = axis_plant(resonance=(900.0, 0.02), lines=((87.0, 2e-6),))


def residual_variance(plant, controller):
    return analysis.h2(analysis.close(plant, controller))[RESIDUAL].sum()


def augmented(plant):
    """States and last command, driven by increments of the command."""
    s, n = plant.system, plant.system.order
    A = np.block([[s.A, s.B[:, :1]], [np.zeros((1, n)), np.ones((1, 1))]])
    return A, np.vstack([s.B[:, :1], [[1.0]]]), np.append(s.C[RESIDUAL], 0.0)[None]


def in_microradians(plant):
    """The same plant with its outputs in urad."""
    s = plant.system
    return replace(plant, system=replace(s, C=1e6 * s.C, D=1e6 * s.D), gain_rad_v=1e6 * plant.gain_rad_v)


def simulate(plant, controller, white, disturbance, limit=math.inf, windup=True):
    """Difference equations with a clipped command and an added error: residual, command, innovation of the observer."""
    p, c, seen = plant.system, controller.system, lqg.in_own_units(plant).system.C[[OPTICAL, GAUGE]]
    L = controller.anti_windup[:, 0] if windup else np.zeros(c.order)
    x, xc, residual, command, states = np.zeros(p.order), np.zeros(c.order), [], [], []
    for w, d in zip(white, disturbance, strict=True):
        out = p.C @ x + p.D[:, 1:] @ w + d * np.array([1.0, 1.0, 0.0])
        m = out[[OPTICAL, GAUGE]]
        asked = float((c.C @ xc + c.D @ m)[0])
        v = min(max(asked, -limit), limit)
        residual.append(out[RESIDUAL])
        command.append(v)
        states.append(m - seen @ xc[: p.order])
        x = p.A @ x + p.B[:, 0] * v + p.B[:, 1:] @ w
        xc = c.A @ xc + c.B @ m + L * (v - asked)
    return np.array(residual), np.array(command), np.array(states)


# ------------------------------------------------------------------------------------------------ the optimum


@pytest.mark.promise("pointing-20", "sampled-loop-6")
@pytest.mark.parametrize("noise_rad", [0.1e-6, 1e-6, 20e-6])
@pytest.mark.parametrize("corner_hz", [1.0, 100.0])
def test_a_scalar_loop_reaches_the_prediction_error_of_its_riccati_equation(noise_rad, corner_hz):
    """y[k+1] = g v[k]: what is left is the error of predicting d one sample ahead, p = a^2 p r / (p + r) + q."""
    plant = axis_plant(delay=0, amplifier_hz=math.inf, gauge=False, noise_rad=noise_rad, corner_hz=corner_hz)
    a, r = math.exp(-2 * math.pi * corner_hz * PERIOD), noise_rad**2
    q = 11.2e-6**2 * (1 - a**2)
    half = 0.5 * (r * (1 - a**2) - q)
    p = -half + math.sqrt(half**2 + q * r)
    assert p == near(a**2 * p * r / (p + r) + q)
    controller = lqg.lqg_controller(plant, EXACT)
    assert residual_variance(plant, controller) == near(p, rel=1e-4)
    weighted = lqg.lqg_controller(plant, replace(EXACT, command=0.3))
    assert residual_variance(plant, weighted) > 1.0005 * p
    misled = lqg.lqg_controller(plant, replace(EXACT, sensor_noise=4.0))
    assert residual_variance(plant, misled) > 1.00001 * p


@pytest.mark.promise("pointing-20")
@pytest.mark.parametrize("weight", [1e-4, 1e-2, 1.0])
@pytest.mark.parametrize("gauge", [True, False])
def test_the_cost_is_that_of_the_separation_principle(weight, gauge):
    """tr(M W) + G' P G (b' X b + weight), X and P from scipy, M = X - X b (b' X b + weight)^-1 b' X."""
    plant = axis_plant(resonance=(900.0, 0.02), gauge=gauge, corner_hz=20.0, lines=((87.0, 2e-6),))
    plant = in_microradians(plant)  # scipy's solution loses the optimum's digits when it is given radians
    s, rho = plant.system, weight * plant.gain_rad_v**2
    A, b, c = augmented(plant)
    X = solve_discrete_are(A, b, c.T @ c, np.array([[rho]]))
    seen = [OPTICAL, GAUGE] if gauge else [OPTICAL]
    W = s.B[:, 1:] @ s.B[:, 1:].T
    P = solve_discrete_are(s.A.T, s.C[seen].T, W, s.D[seen, 1:] @ s.D[seen, 1:].T)
    W, P = block_diag(W, 0.0), block_diag(P, 0.0)
    size = (b.T @ X @ b)[0, 0] + rho
    G = b.T @ X / size
    optimum = np.trace((X - X @ b @ G) @ W) + size * (G @ P @ G.T)[0, 0]
    controller = lqg.lqg_controller(plant, replace(EXACT, command=weight))
    assert cost(plant, controller, rho) == near(optimum, rel=2e-4)
    for other in (0.5 * weight, 2.0 * weight):
        assert cost(plant, lqg.lqg_controller(plant, replace(EXACT, command=other)), rho) > optimum * (1 + 1e-6)


def cost(plant, controller, rho):
    """Variance of the residual plus rho times that of the command's increments."""
    closed = analysis.close(plant, controller)
    P = solve_discrete_lyapunov(closed.A, closed.B @ closed.B.T)
    c, d = closed.C[analysis.COMMAND], closed.D[analysis.COMMAND]
    size, next_one = c @ P @ c + d @ d, c @ (closed.A @ P @ c + closed.B @ d)
    return closed.C[RESIDUAL] @ P @ closed.C[RESIDUAL] + rho * 2.0 * (size - next_one)


@pytest.mark.promise("pointing-20", "sampled-loop-6")
def test_no_pi_on_a_fine_grid_beats_it():
    plant = axis_plant(gauge=False)
    best = math.inf
    for integral in np.geomspace(1e6, 2e7, 25):
        for proportional in np.geomspace(1e2, 1e4, 15):
            step = integral * PERIOD
            s = lti.StateSpace(
                np.ones((1, 1)), np.array([[step, 0.0]]), np.ones((1, 1)), np.array([[proportional + step, 0.0]])
            )
            pi = AxisController("PI", s, np.zeros((1, 1)))
            if abs(analysis.loop_poles(plant, pi)[0]) < 1.0:
                best = min(best, residual_variance(plant, pi))
    ours = residual_variance(plant, lqg.lqg_controller(plant, EXACT))
    print(f"PI {1e6 * math.sqrt(best):.3f} urad, LQG {1e6 * math.sqrt(ours):.3f} urad")
    assert 0.3 * best < ours < best


def test_the_gauge_helps_where_the_command_is_noisy():
    s = FULL.system
    B = np.hstack([s.B[:, :2], 0.02 * s.B[:, :1], s.B[:, 2:]])  # one more disturbance, on the command
    shaken = replace(FULL, system=replace(s, B=B, D=np.insert(s.D, 2, 0.0, axis=1)), disturbances=FULL.disturbances + 1)
    blind = replace(shaken, has_gauge=False)
    with_gauge, without = (lqg.lqg_controller(p, EXACT) for p in (shaken, blind))
    assert np.all(without.system.D[:, 1] == 0.0)
    assert np.all(without.system.B[:, 1] == 0.0)
    assert with_gauge.system.D[0, 1] != 0.0
    assert residual_variance(shaken, with_gauge) < 0.95 * residual_variance(shaken, without)


def test_noise_that_comes_late_is_noise_all_the_same():
    """The optical sensor's reading one sample late, noise included: nothing of it is in the sample itself."""
    plain = axis_plant(gauge=False)
    s, n = plain.system, plain.system.order
    A, B = np.pad(s.A, ((0, 1), (0, 1))), np.vstack([s.B, s.D[OPTICAL]])
    A[n, :n] = s.C[OPTICAL]
    C, D = np.pad(s.C, ((0, 0), (0, 1))), s.D.copy()
    C[OPTICAL], D[OPTICAL] = np.eye(n + 1)[n], 0.0
    late = replace(plain, system=lti.StateSpace(A, B, C, D))
    later = axis_plant(gauge=False, delay=2)  # a sample of delay is the same wherever it is
    ours, theirs = (residual_variance(p, lqg.lqg_controller(p, EXACT)) for p in (late, later))
    assert ours == near(theirs, rel=1e-3)
    assert ours > 1.05 * residual_variance(plain, lqg.lqg_controller(plain, EXACT))
    for ours, theirs in zip(LQG.parameters(late), LQG.parameters(plain), strict=True):
        assert (ours.least, ours.most) == near((theirs.least, theirs.most))


# ------------------------------------------------------------------------------------------------ equations


def test_riccati_solutions_are_those_of_scipy():
    rng = np.random.Generator(np.random.Philox(4))
    for n, m in ((1, 1), (4, 1), (9, 2), (16, 2)):
        A = rng.normal(size=(n, n)) * 1.2 / math.sqrt(n)
        B, C = rng.normal(size=(n, m)), rng.normal(size=(2, n))
        R = np.diag(rng.uniform(0.01, 2.0, m))
        expected = solve_discrete_are(A, B, C.T @ C, R)
        assert_allclose(lqg.riccati(A, B, C.T @ C, R, ""), expected, rtol=1e-7, atol=1e-8 * np.max(expected))


def test_doubling_runs_as_it_is_without_the_compiler_and_the_compiled_gramian_is_that_of_arrays():
    rng = np.random.Generator(np.random.Philox(5))
    A, b, c = rng.normal(size=(5, 5)), rng.normal(size=(5, 1)), rng.normal(size=(2, 5))
    solved = []
    for kernel in (kernels.riccati_kernel, kernels.riccati_kernel.py_func):
        X = c.T @ c
        assert kernel(A.copy(), b @ b.T, X, np.empty((4, 5, 5)), np.empty((5, 10)))
        solved.append(X)
    assert_allclose(solved[0], solved[1], rtol=1e-9)
    assert not kernels.riccati_kernel(2.0 * A, 0.0 * (b @ b.T), c.T @ c, np.empty((4, 5, 5)), np.empty((5, 10)))
    stable, Q = 0.1 * A, c.T @ c
    expected = lti.gramian(stable, Q)
    for kernel in (kernels.gramian_kernel, kernels.gramian_kernel.py_func):
        X = Q.copy()
        kernel(stable.copy(), X, np.empty((3, 5, 5)))
        assert_allclose(X, expected, rtol=1e-12)
    assert np.max(np.abs(expected - Q)) > 0.01 * np.max(Q)


def test_a_gain_that_is_known_already_is_the_one_that_is_solved_for():
    """Weights that share an observer or a regulator with earlier ones; another plant shares nothing."""
    first = Weights(0.1, 1.0, 1e-3)
    several = [first, replace(first, command=0.3), replace(first, sensor_noise=2.0), replace(first, walk=0.0), first]
    found = [lqg.lqg_controller(FULL, weights).system for weights in several]
    for weights, system in zip(several, found, strict=True):
        alone = lqg.lqg_controller(replace(FULL), weights).system
        assert all(np.array_equal(getattr(system, key), getattr(alone, key)) for key in "ABCD")
    assert not any(np.array_equal(found[0].C, other.C) for other in found[1:4])
    louder = replace(FULL, system=replace(FULL.system, B=2.0 * FULL.system.B))
    assert not np.array_equal(lqg.lqg_controller(louder, first).system.C, found[0].C)


def test_the_filter_gain_takes_noise_that_sensor_and_states_share():
    rng = np.random.Generator(np.random.Philox(6))
    A, C = 0.4 * rng.normal(size=(5, 5)), rng.normal(size=(2, 5))
    noise, seen_noise = rng.normal(size=(5, 4)), rng.normal(size=(2, 4))
    Q, N, R = noise @ noise.T, noise @ seen_noise.T, seen_noise @ seen_noise.T
    P = solve_discrete_are(A.T, C.T, Q, R, s=N)
    expected = (A @ P @ C.T + N) @ np.linalg.inv(C @ P @ C.T + R)
    assert_allclose(lqg.filter_gain(A, noise, C, seen_noise), expected, rtol=1e-8, atol=1e-10)


def test_the_regulator_is_that_of_scipy_on_the_whole_system():
    model = lqg.observed(FULL, replace(EXACT, command=0.1))
    A, b, c = augmented(FULL)
    rho = 0.1 * FULL.gain_rad_v**2
    X = solve_discrete_are(A, b, 1e12 * c.T @ c, np.array([[1e12 * rho]])) / 1e12
    expected = b.T @ X / (b.T @ X @ b + rho)
    assert_allclose(lqg.regulator_gain(model, rho), expected, rtol=1e-5, atol=1e-7)


def test_an_undamped_line_needs_no_damping():
    """No pole of the disturbance has to be moved: the limit of ever less damping, where the Riccati equation ends."""
    s = FULL.system
    line = slice(s.order - 2, s.order)

    def damped(radius):
        A = s.A.copy()
        A[line, line] *= radius / math.sqrt(np.linalg.det(A[line, line]))
        return replace(FULL, system=replace(s, A=A))

    undamped = lqg.lqg_controller(damped(1.0), PLAIN)
    near = lqg.lqg_controller(damped(1.0 - 1e-7), PLAIN)
    far = lqg.lqg_controller(damped(1.0 - 1e-2), PLAIN)
    freq_hz = np.array([10.0, 86.0, 300.0])
    there, close, away = (lti.frequency_response(c.system, freq_hz, PERIOD) for c in (undamped, near, far))
    assert_allclose(there, close, rtol=1e-4)
    assert np.max(np.abs(away / there - 1)) > 0.05
    analysis.refuse_unstable(FULL, undamped)
    w = np.exp(2j * math.pi * 87.0 * PERIOD * math.sqrt(1 - 1e-6))
    assert np.min(np.abs(np.linalg.eigvals(s.A[line, line]) / 1.0 - 0.99989 * w)) < 1e-3  # that is where the line is
    deep = np.abs(1 + analysis.loop_response(FULL, undamped, np.array([80.0, 87.0]), "optical"))
    assert deep[1] > 3.0 * deep[0]


def test_equations_without_a_solution_are_refused():
    unseen = np.diag([1.1, 0.5])
    with pytest.raises(
        ValueError, match="no stabilising solution: the sensors do not see every state that drifts; add"
    ):
        lqg.filter_gain(unseen, np.eye(2, 3), np.array([[0.0, 1.0]]), np.array([[0.0, 0.0, 1.0]]))
    with pytest.raises(ValueError, match="the disturbance grows faster than the loop settles"):
        lqg.stein(np.array([[0.5]]), np.array([[2.1]]), np.ones((1, 1)))
    assert lqg.stein(np.array([[0.5]]), np.array([[1.5]]), np.ones((1, 1)))[0, 0] == near(4.0)


def test_a_plant_without_optical_sensor_is_refused():
    with pytest.raises(ValueError, match=r"LQG needs the optical sensor: .*; add one, or close the loop on the gauge"):
        LQG.parameters(replace(FULL, has_optical=False))


@pytest.mark.parametrize("change", [{"command": 0.0}, {"sensor_noise": -1.0}, {"command": math.nan}])
def test_weights_without_an_optimum_are_refused(change):
    """Also behind a design of the same plant, of which gains are known by then."""
    lqg.lqg_controller(FULL, PLAIN)
    with pytest.raises(ValueError, match=r"LQG: a command weight of .* have no optimum: both have to be above 0"):
        lqg.lqg_controller(FULL, replace(PLAIN, **change))


# ------------------------------------------------------------------------------------------------ as a controller


@pytest.mark.parametrize("plant", [FULL, axis_plant(gauge=False, delay=3), axis_plant(corner_hz=1e-2, noise_rad=0.0)])
def test_it_is_stable_and_drives_a_constant_error_to_zero(plant):
    controller = lqg.lqg_controller(plant, PLAIN)
    margins = analysis.loop_margins(plant, controller)
    assert margins.modulus > 0.3
    low = np.abs(1 + analysis.loop_response(plant, controller, np.array([1e-3, 1e-4]), "optical"))
    assert low[1] / low[0] == near(10.0, rel=0.05)
    without = lqg.lqg_controller(plant, replace(PLAIN, walk=0.0))
    low = np.abs(1 + analysis.loop_response(plant, without, np.array([1e-3, 1e-5]), "optical"))
    assert low[1] / low[0] < 20.0


def test_the_walk_for_integral_action_costs_next_to_nothing():
    plain, walking = (lqg.lqg_controller(FULL, replace(EXACT, walk=walk)) for walk in (0.0, 1.0))
    ratio = residual_variance(FULL, walking) / residual_variance(FULL, plain)
    assert 1.0 < ratio < 1.005


def test_a_disturbance_that_already_walks_gets_no_second_walk():
    s = FULL.system
    A = s.A.copy()
    A[-3, -3] = 1.0
    walking = replace(FULL, system=replace(s, A=A))
    assert lqg.lqg_controller(walking, PLAIN).system.order == lqg.lqg_controller(FULL, PLAIN).system.order - 1


def test_noise_on_the_command_makes_it_bear_a_resonance_that_is_not_where_the_model_has_it():
    model, elsewhere = (axis_plant(resonance=(freq_hz, 0.02)) for freq_hz in (900.0, 1000.0))
    trusting, careful = (
        lqg.lqg_controller(model, replace(PLAIN, command=1e-3, command_noise_v=noise)) for noise in (0.0, 1e-3)
    )
    assert analysis.loop_margins(model, trusting).modulus > 0.6
    with pytest.raises(ValueError, match="unstable"):
        analysis.loop_margins(elsewhere, trusting)
    assert analysis.loop_margins(elsewhere, careful).modulus > 0.5
    price = residual_variance(model, careful) / residual_variance(model, trusting)
    assert 1.0 < price < 1.02


def test_the_family_builds_every_corner_of_its_parameters():
    for plant in (FULL, axis_plant(gauge=False), axis_plant(corner_hz=1e-2, disturbance_rad=1e-4)):
        parameters = LQG.parameters(plant)
        assert [p.name for p in parameters] == ["command weight", "sensor noise factor", "command noise"]
        for corner in np.ndindex(2, 2, 2):
            values = np.array([(p.least, p.most)[i] for p, i in zip(parameters, corner, strict=True)])
            analysis.refuse_unstable(plant, LQG.build(plant, values))


# ------------------------------------------------------------------------------------------------ saturation


def test_the_observer_knows_what_was_clipped():
    """Its innovation is that of the plant's noise alone: the same with and without a limit that is hit."""
    controller = lqg.lqg_controller(FULL, replace(EXACT, command=1e-2))
    white = np.random.Generator(np.random.Philox(8)).standard_normal((1500, FULL.disturbances + 2))
    still = np.zeros(1500)
    _, command, free = simulate(FULL, controller, white, still)
    limit = 0.3 * np.max(np.abs(command))
    _, clipped, bound = simulate(FULL, controller, white, still, limit)
    assert np.mean(np.abs(clipped) >= limit) > 0.2
    assert_allclose(bound, free, rtol=0, atol=1e-9 * np.max(np.abs(free)))
    _, _, wrong = simulate(FULL, controller, white, still, limit, windup=False)
    assert np.max(np.abs(wrong - free)) > 0.5 * np.max(np.abs(free))


def test_it_comes_back_from_the_limit_without_winding_up():
    plant = axis_plant(resonance=(900.0, 0.02))
    controller = lqg.lqg_controller(plant, PLAIN)
    n, start, end = 1500, 200, 700
    white = np.zeros((n, plant.disturbances + 2))
    push = np.zeros(n)
    push[start:end] = 300e-6  # twice what the limit reaches
    limit = 150e-6 / plant.gain_rad_v
    residual, command, _ = simulate(plant, controller, white, push, limit)
    assert np.all(command[start + 20 : end] == limit)
    assert residual[end - 1] == near(150e-6, rel=1e-4)
    free, _, _ = simulate(plant, controller, white, push)
    wound, _, _ = simulate(plant, controller, white, push, limit, windup=False)
    after = [np.sum(np.abs(r[end + 4 : end + 20])) for r in (residual, free, wound)]  # the first the loop can act on
    print(f"left behind: {after[0]:.2e} rad samples, without a limit {after[1]:.2e}, wound up {after[2]:.2e}")
    assert after[0] == near(after[1], rel=0.1)
    assert after[2] > 1.4 * after[0]


# ------------------------------------------------------------------------------------------------ parts by hand
def test_each_state_is_in_a_unit_of_about_what_some_thousand_samples_of_it_build_up():
    plant = axis_plant(resonance=(700.0, 0.01), corner_hz=0.3)
    found, s = lqg.in_own_units(plant), plant.system
    total, power = np.zeros_like(s.A), s.B @ s.B.T
    for _ in range(30_000):
        total, power = total + power, 0.998001 * s.A @ power @ s.A.T
    unit = 2.0 ** np.round(np.log2(np.sqrt(np.diag(total))))
    assert_allclose(found.system.A, s.A * unit / unit[:, None], rtol=1e-12)
    assert_allclose(found.system.B * unit[:, None], s.B, rtol=1e-12)
    assert_allclose(found.system.C / unit, s.C, rtol=1e-12)
    assert (found.system.D is s.D, found.gain_rad_v, found.period_s) == (True, plant.gain_rad_v, plant.period_s)


@pytest.mark.parametrize(("left", "right"), [(0.9, 0.5), (0.99, 1.0), (0.9999, 1.0), (0.3, 1e-6), (0.7, 1.2)])
def test_a_stein_equation_is_solved_however_slowly_its_sum_settles(left, right):
    cos, sin = np.cos(1.0), np.sin(1.0)
    A, B = left * np.array([[1.0, 0.0], [0.0, 0.4]]), right * np.array([[cos, sin], [-sin, cos]])
    Q = np.array([[1.0, -2.0], [0.5, 3.0]])
    Z = lqg.stein(A, B, Q)
    assert_allclose(Z, A.T @ Z @ B + Q, rtol=1e-9, atol=1e-9)


def test_a_stein_equation_without_a_sum_is_refused():
    with pytest.raises(ValueError, match="the disturbance grows faster than the loop settles"):
        lqg.stein(np.array([[0.8]]), np.array([[1.25]]), np.ones((1, 1)))


@pytest.mark.parametrize("gauge", [True, False])
def test_what_a_design_knows_is_the_plant_with_a_walk_noise_on_its_command_and_the_sensors_that_it_has(gauge):
    plant, weights = axis_plant(resonance=(700.0, 0.01), gauge=gauge), lqg.Weights(1.0, 3.0, 0.5, 2.0)
    found, s, n = lqg.observed(plant, weights), plant.system, plant.system.order
    there = lti.frequency_response(s, np.array([1e-4 / plant.period_s]), plant.period_s)[0, :, 1:]
    level = max(np.linalg.norm(there[0]), np.linalg.norm(there[1]))
    rows = [1, 2] if gauge else [1]
    assert found.sensors == [row - 1 for row in rows]
    assert_allclose(found.A, np.block([[s.A, np.zeros((n, 1))], [np.zeros((1, n)), np.ones((1, 1))]]))
    assert_allclose(found.command, np.vstack([s.B[:, :1], [[0.0]]]))
    assert_allclose(found.residual, [[*s.C[0], 1.0]])
    assert_allclose(found.seen, [[*s.C[row], float(row == 1)] for row in rows])
    scale = np.array([1.0, 3.0, 3.0])
    noise = np.zeros((n + 1, 5 + len(rows)))
    noise[:n, :3], noise[:n, 3], noise[n, 4] = s.B[:, 1:] * scale, 0.5 * s.B[:, 0], 2.0 * 2 * np.pi * 1e-4 * level
    assert_allclose(found.noise, noise, rtol=1e-9)
    floor = 1e-6 * level * np.eye(len(rows))
    assert_allclose(found.seen_noise, np.hstack([s.D[rows, 1:] * scale, np.zeros((len(rows), 2)), floor]), rtol=1e-9)
    assert found.moved.tolist() == [*analysis.reachable(s.A, s.B[:, :1]), False]
    without = lqg.observed(plant, lqg.Weights(1.0, 3.0, 0.5, 0.0))
    assert (without.A.shape, without.seen.shape, without.noise.shape) == ((n, n), (len(rows), n), (n, 5 + len(rows)))


@pytest.mark.parametrize("gauge", [True, False])
def test_the_command_noise_is_sought_around_what_the_sensors_noise_is_worth_in_volts(gauge):
    plant = axis_plant(gauge=gauge, noise_rad=4e-6)
    weight, factor, noise = LQG.parameters(plant)
    assert (weight.least, weight.most, weight.gentle, factor.least, factor.most, factor.gentle) == (
        1e-4, 1e2, 1e2, 0.1, 30.0, 30.0
    )  # fmt: skip
    unit = 4e-6 / plant.gain_rad_v
    assert (noise.least, noise.most, noise.gentle, noise.unit) == (
        pytest.approx(1e-3 * unit, rel=1e-6), pytest.approx(10.0 * unit, rel=1e-6), None, "V"
    )  # fmt: skip
    quiet = LQG.parameters(axis_plant(gauge=gauge, noise_rad=0.0))[2]
    there = lti.frequency_response(plant.system, np.array([0.5]), plant.period_s)[0, 0, 1]
    assert quiet.most == pytest.approx(10.0 * 1e-6 * abs(there) / plant.gain_rad_v, rel=1e-6)


@pytest.mark.parametrize("gain", [8e-5, -8e-5])
def test_the_command_noise_of_several_axes_is_that_of_one_whichever_way_the_mirror_turns(gain):
    rng, D = np.random.default_rng(2), np.zeros((4, 7))
    D[2, 5], D[3, 6] = 3e-6, 4e-6
    A = np.diag([0.5, 0.9, 0.3])
    s = lti.StateSpace(A, rng.standard_normal((3, 7)) * [1, 1, 1, 1, 1, 0, 0], rng.standard_normal((4, 3)) * 1e-5, D)
    noise = LQG_OF_AXES.parameters(WholePlant(PERIOD, s, 2, 3, gain))[2]
    assert noise.least == pytest.approx(1e-3 * 5e-6 / (math.sqrt(2.0) * 8e-5), rel=1e-9)
    assert noise.most == pytest.approx(1e4 * noise.least, rel=1e-9)
    quiet = LQG_OF_AXES.parameters(WholePlant(PERIOD, replace(s, D=0.0 * D), 2, 3, gain))[2]
    there = lti.frequency_response(s, np.array([1e-4 / PERIOD]), PERIOD)[0, 2:, 2:5]
    assert quiet.most == pytest.approx(10 * 1e-6 * np.linalg.norm(there) / (math.sqrt(2.0) * 8e-5), rel=1e-9)


def test_what_a_design_of_several_axes_knows_has_a_walk_on_each_axis_of_the_size_of_its_own_reading():
    rng, n = np.random.default_rng(7), 4
    s = lti.StateSpace(
        np.diag([0.5, 0.9, 0.3, 0.8]), rng.standard_normal((n, 7)) * [1, 1, 1, 1, 1, 0, 0],
        rng.standard_normal((4, n)), np.vstack([np.zeros((2, 7)), np.pad(np.diag([0.3, 0.7]), ((0, 0), (5, 0)))]),
    )  # fmt: skip
    found = lqg._observed_axes(WholePlant(PERIOD, s, 2, 3, 1e-4), Weights(1.0, 3.0, 0.5, 2.0))
    there = lti.frequency_response(s, np.array([1e-4 / PERIOD]), PERIOD)[0, 2:, 2:]
    level = np.sqrt(np.sum(np.abs(there) ** 2, axis=1))
    scale = np.array([1.0, 1.0, 1.0, 3.0, 3.0])
    noise = np.zeros((n + 2, 5 + 3 * 2))
    noise[:n, :5], noise[:n, 5:7] = s.B[:, 2:] * scale, 0.5 * s.B[:, :2]
    noise[4, 7], noise[5, 8] = 2.0 * 2 * np.pi * 1e-4 * level
    assert_allclose(found.noise, noise, rtol=1e-9)
    seen_noise = np.hstack([s.D[2:, 2:] * scale, np.zeros((2, 4)), 1e-6 * np.diag(level)])
    assert_allclose(found.seen_noise, seen_noise, rtol=1e-9)
    assert_allclose(found.A, block_diag(s.A, np.eye(2)))
    assert_allclose(found.command, np.vstack([s.B[:, :2], np.zeros((2, 2))]))
    assert_allclose(found.residual, np.hstack([s.C[:2], np.eye(2)]))
    assert_allclose(found.seen, np.hstack([s.C[2:], np.eye(2)]))
    assert (found.sensors, found.moved.tolist()) == ([0, 1], [True] * 4 + [False] * 2)


def test_what_is_known_of_a_plant_is_that_of_the_weights_that_are_asked_for():
    """One weight after the other is changed, and changed back, on one plant and on a new one each time."""
    first = Weights(1e-2, 1.0, 1e-3, 0.5)
    changes = ({}, {"sensor_noise": 3.0}, {"command_noise_v": 4e-3}, {"walk": 2.0}, {"command": 5e-2}, {})
    plant = axis_plant(resonance=(900.0, 0.02))
    found = [lqg.lqg_controller(plant, replace(first, **change)).system for change in changes]
    alone = [lqg.lqg_controller(replace(plant), replace(first, **change)).system for change in changes]
    for one, other in zip(found, alone, strict=True):
        for key in "ABCD":
            assert_allclose(getattr(one, key), getattr(other, key), rtol=1e-9, atol=1e-12)
    unlike = {tuple(np.round(one.D[0] / found[0].D[0], 6)) for one in found}
    assert len(unlike) == len(changes) - 1


def test_answers_are_kept_for_a_few_plants_and_each_has_its_own():
    asked = []

    def name_of(plant):
        """What a plant is called."""
        asked.append(plant[0])
        return f"plant {plant[0]}"

    kept = once_per_plant(name_of)
    assert (kept.__name__, kept.__doc__) == ("name_of", "What a plant is called.")
    plants = [[n] for n in range(6)]
    for of in (plants[0], plants[1], plants[0], plants[1], plants[2], plants[3], plants[0]):
        assert kept(of) == f"plant {of[0]}"
    assert asked == [0, 1, 2, 3]
    assert kept([0]) == "plant 0"  # another plant, however alike
    assert asked == [0, 1, 2, 3, 0]
    assert [kept(of) for of in plants] == [f"plant {n}" for n in range(6)]
    assert asked == [0, 1, 2, 3, 0, 0, 1, 2, 3, 4, 5]


@pytest.mark.parametrize("axes", [1, 2])
def test_what_is_used_in_the_end_has_coarser_numbers_than_what_a_search_looks_at(axes):
    if axes == 1:
        family, plant, values = LQG, axis_plant(resonance=(900.0, 0.02)), np.array([1e-2, 1.0, 1e-3])
    else:
        two = [axis_plant(gauge=False, noise_rad=n, amplifier_hz=a).system for n, a in ((1e-6, 1e3), (3e-6, 700.0))]
        order = [0, 3, 1, 4, 2, 5]  # commands, disturbances, noise
        B, D = block_diag(*(s.B[:, :3] for s in two)), block_diag(*(s.D[:2, :3] for s in two))
        C = block_diag(*(s.C[:2] for s in two))[[0, 2, 1, 3]]
        s = lti.StateSpace(block_diag(*(s.A for s in two)), B[:, order], C, D[[0, 2, 1, 3]][:, order])
        family, plant, values = LQG_OF_AXES, WholePlant(PERIOD, s, 2, 2, 0.089e-3), np.array([1e-2, 1.0, 1e-3])
    smooth, used = family.build(plant, values), family.final(plant, values)
    for key in "ABCD":
        fine, coarse = getattr(smooth.system, key), getattr(used.system, key)
        assert np.array_equal(coarse, lti.to_bits(coarse, 32))
        assert not np.array_equal(fine, lti.to_bits(fine, 32))
        assert_allclose(coarse, fine, rtol=0.0, atol=1e-5 * np.max(np.abs(fine)))
    gains = []
    for made in (smooth, used):
        gain = made.system.B - made.anti_windup @ made.system.D
        gains.append(gain[np.abs(gain) > 1e-5 * np.max(np.abs(gain))])
    off = [np.max(np.abs(gain / lti.to_bits(gain, 24) - 1.0)) for gain in gains]
    assert off[0] > 1e-9 > off[1]
    assert used.anti_windup.tolist() == smooth.anti_windup.tolist()


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"command": -2.0}, "of -2 and a sensor noise factor of 1 "),
        ({"sensor_noise": 0.0}, "of 0.01 and a sensor noise factor of 0 "),
        ({"sensor_noise": math.nan}, "of 0.01 and a sensor noise factor of nan "),
    ],
)
def test_each_weight_has_to_be_above_nothing(change, said):
    with pytest.raises(ValueError, match=f"^LQG: a command weight {said}have no optimum: both have to be above 0"):
        lqg.lqg_controller(FULL, replace(PLAIN, **change))


def test_equations_leave_their_matrices_as_they_are():
    rng = np.random.default_rng(11)
    A, B, N = 0.4 * rng.standard_normal((4, 4)), rng.standard_normal((4, 2)), rng.standard_normal((4, 4))
    Q, R = N @ N.T, np.diag([2.0, 3.0])
    kept = [each.copy() for each in (A, B, Q, R)]
    first = lqg.riccati(A, B, Q, R, "none")
    assert_allclose(first, solve_discrete_are(A, B, Q, R), rtol=1e-9)
    assert np.array_equal(first, lqg.riccati(A, B, Q, R, "none"))
    stable = A / (1.1 * np.max(np.abs(np.linalg.eigvals(A))))
    kept.append(stable.copy())
    found = lqg._gramian(stable, Q)
    assert_allclose(found, solve_discrete_lyapunov(stable.T, Q), rtol=1e-9)
    assert np.array_equal(found, lqg._gramian(stable, Q))
    assert_allclose(lqg.stein(stable, 0.5 * stable, Q), lqg.stein(stable, 0.5 * stable, Q), rtol=0.0)
    for each, before in zip((A, B, Q, R, stable), kept, strict=True):
        assert np.array_equal(each, before)
