"""Sections of exported controllers against plain recursions of the matrices they come from, and names in C."""

import math
import os
import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import designs
from microrad.core import lti
from microrad.export import choice
from microrad.export.flight import c_code
from microrad.export.identifiers import LONGEST, identifier, suggested
from microrad.export.linear_part import block_diagonal as block_diagonal_form
from microrad.export.linear_part import block_diagonal as parting
from microrad.export.linear_part import modes as modes_module
from microrad.export.linear_part import sections as sections_module
from microrad.export.linear_part.block_diagonal import block_diagonal
from microrad.export.linear_part.modes import minimal, modes
from microrad.export.linear_part.sections import MODAL, TRIANGULAR, sections
from microrad.export.records import ExportError, FlightController, Origin, Signal

PERIOD = 1e-3
RECORDED, LONG = 1000, 30_000 if os.environ.get("MICRORAD_ENDURANCE") else 4000
WIDE = np.finfo(np.longdouble).eps < 1e-18  # the form is refined at a precision that some machines do not have
FLYING = ("PI + inverse", "PI + inverse in series", "LQG", "disturbance observer", "PID")


# ------------------------------------------------------------------------------------------------ systems and replays
def controller(A, B, C, D=None, L=None, period_s=PERIOD):
    """A controller of these matrices: one input signal and as many actuators as L has columns."""
    A = np.array(A, dtype=float)
    B, C = (np.array(each, dtype=float) for each in (B, C))
    B, C = (B, C) if A.size == 0 else (B.reshape(len(A), -1), C.reshape(-1, len(A)))
    D = np.zeros((len(C), B.shape[1])) if D is None else np.array(D, dtype=float)
    L = np.zeros((len(A), 1)) if L is None else np.array(L, dtype=float).reshape(len(A), -1)
    return FlightController(
        name="tried",
        origin=Origin("by hand", "0" * 64, "none"),
        period_s=period_s,
        inputs=(Signal("reading_rad", B.shape[1], "rad", "what is read", 1.0),),
        actuators=L.shape[1],
        system=lti.StateSpace(A, B, C, D),
        anti_windup=L,
        inverse=None,
        minimum_v=-1.0,
        maximum_v=1.0,
        resolution_v=0.0,
        bias_v=0.0,
        margins=(),
    )


def replay(system, windup, inputs, limit, first=0):
    """The plain recursion of dense matrices: the outputs. From the ``first`` on, one by actuator is clipped, and what
    that takes off goes to the states (with an inverse in series the command itself is made of the target behind it)."""
    commands, x = slice(first, first + windup.shape[1]), np.zeros(system.order)
    drive, direct, outputs = inputs @ system.B.T, inputs @ system.D.T, np.empty((len(inputs), len(system.D)))
    for k in range(len(inputs)):
        outputs[k] = y = system.C @ x + direct[k]
        v = y[commands]
        x = system.A @ x + drive[k] + windup @ (np.minimum(np.maximum(v, -limit), limit) - v)
    return outputs


def by_sections(form, inputs, limit, first=0):
    """The same with the blocks."""
    commands = slice(first, first + form.L.shape[1])
    x, outputs = np.zeros(form.order), np.empty((len(inputs), len(form.D)))
    drive, direct = inputs @ form.B.T, inputs @ form.D.T
    for k in range(len(inputs)):
        outputs[k] = y = form.C @ x + direct[k]
        v = y[commands]
        clipped = np.minimum(np.maximum(v, -limit), limit) - v
        x = form.A @ x + drive[k] + form.L @ clipped
    return outputs


def difference(of, inputs, share=math.inf, form=None):
    """Largest difference of the sections from the original, by output over its peak, and how many commands it clipped:
    those beyond this share of the peak that they come to in the beginning, without a limit."""
    form = sections(of) if form is None else form
    free = np.max(np.abs(replay(of.system, of.anti_windup, inputs[:2000], math.inf)), axis=0)
    first = 0 if free[0] > 0.0 else of.actuators
    limit = share * free[first]
    wanted = replay(of.system, of.anti_windup, inputs, limit, first)
    apart = np.max(np.abs(by_sections(form, inputs, limit, first) - wanted), axis=0)
    peak = np.max(np.abs(wanted), axis=0)
    assert not np.any(apart[peak == 0.0])
    clipped = np.count_nonzero(np.abs(wanted[:, first : first + of.actuators]) > limit)
    return float(np.max(apart[peak > 0.0] / peak[peak > 0.0])), clipped


def last_bits(of, inputs):
    """By how much the last bits of the matrices move the outputs: no form of a controller is nearer to it than that.

    The most of eight draws, each number a bit up or down. A mode that is hidden by a zero shows where that misses it.
    """
    rng, wanted = np.random.default_rng(1), replay(of.system, of.anti_windup, inputs, math.inf)
    peak = np.max(np.abs(wanted), axis=0)
    most = 0.0
    for _ in range(8):
        matrices = {name: getattr(of.system, name) for name in "ABCD"}
        moved = {name: m * (1.0 + np.finfo(float).eps * rng.choice([-1, 1], m.shape)) for name, m in matrices.items()}
        apart = np.max(np.abs(replay(replace(of.system, **moved), of.anti_windup, inputs, math.inf) - wanted), axis=0)
        most = max(most, float(np.max(apart[peak > 0.0] / peak[peak > 0.0])))
    return most


def noise(of, samples, seed=1):
    return np.random.default_rng(seed).normal(size=(samples, of.system.B.shape[1]))


def rotation(turn, radius=1.0):
    c, s = radius * math.cos(turn), radius * math.sin(turn)
    return [[c, s], [-s, c]]


def mixed(diagonal, seed=2):
    """A matrix with these eigenvalues and all its entries filled: similar by a random orthogonal matrix."""
    Q = np.linalg.qr(np.random.default_rng(seed).normal(size=(len(diagonal),) * 2))[0]
    return Q @ np.diag(diagonal) @ Q.T


TURN = 0.3
SYSTEMS = {
    "gain": controller(np.zeros((0, 0)), np.zeros((0, 2)), np.zeros((1, 0)), [[2.0, -1.0]]),
    "integrator": controller([[1.0]], [0.01], [1.0], [[0.5]], [0.02]),
    "double pole": controller([[0.5, 1.0], [0.0, 0.5]], [0.0, 1.0], [1.0, 0.0], L=[1.0, 0.5]),
    "double pole, companion": controller([[1.2, -0.36], [1.0, 0.0]], [1.0, 0.0], [1.0, 0.0], L=[0.2, 0.1]),
    "triple pole": controller(np.eye(3) * 0.9 + np.eye(3, k=1), [0, 0, 1], [1, 0, 0], L=[0.001, 0.001, 0.001]),
    "delays": controller(np.eye(5, k=-1), np.eye(5)[0], [0, 0, 0.5, 0, 1], [[0.25]], 0.1 * np.eye(5)[0]),
    "undamped oscillator": controller(rotation(TURN), [1.0, 0.0], [0.01, 0.02], L=[0.05, 0.0]),
    "two integrators": controller(np.eye(2), 0.1 * np.eye(2), np.eye(2), L=0.2 * np.eye(2)),
    "two integrators, mixed": controller(mixed([1, 1, 0.5]), [[1, 0], [2, 1], [-1, 3]], np.eye(3)[:2]),
    "by anti-windup alone": controller(np.diag([0.5, 0.7]), [1, 0], [1, 0.5], [[0.3]], [0, 0.4]),
    "odd": controller(np.diag([0.3, 0.2, 0.1]) + np.diag([1, 1], -1), [1, 0, 0], [0, 0, 1], L=[0.1, 0, 0]),
    "integrator behind a filter": controller([[1, 0.3], [0, 0.9]], [0, 1], [0.02, 0], L=[0.01, 0]),
    "slow beside an integrator": controller([[1, 0.3], [0, 0.99999]], [0, 0.01], [0.001, 0.2], L=[0.1, 0]),
}


# -------------------------------------------------------------------------------------------------- systems by hand
@pytest.mark.parametrize("name", SYSTEMS)
def test_sections_replay_their_system(name):
    of = SYSTEMS[name]
    inputs = noise(of, 3000)
    free, never = difference(of, inputs)
    clipped, often = difference(of, inputs, 0.3)
    assert 0.0 <= free < 2e-13 and never == 0
    assert 0.0 <= clipped < 2e-13 and often > 50


@pytest.mark.parametrize("name", SYSTEMS)
def test_sections_keep_the_frequency_response(name):
    of = SYSTEMS[name]
    freq = np.geomspace(1.0, 490.0, 60)
    wanted = lti.frequency_response(of.system, freq, PERIOD)
    got = lti.frequency_response(sections(of).system, freq, PERIOD)
    assert_allclose(got, wanted, rtol=1e-11, atol=1e-12 * np.max(np.abs(wanted)))
    assert np.max(np.abs(wanted)) > 0.1


def test_blocks_are_as_small_as_the_poles_allow():
    forms = {name: sections(of) for name, of in SYSTEMS.items()}
    found = {name: (form.form, tuple(size for _, size in form.blocks)) for name, form in forms.items()}
    assert found == {
        "gain": (MODAL, ()),
        "integrator": (MODAL, (1,)),
        "double pole": (MODAL, (2,)),
        "double pole, companion": (MODAL, (2,)),
        "triple pole": (TRIANGULAR, (3,)),
        "delays": (TRIANGULAR, (5,)),
        "undamped oscillator": (MODAL, (2,)),
        "two integrators": (MODAL, (1, 1)),
        "two integrators, mixed": (MODAL, (1, 1, 1)),
        "by anti-windup alone": (MODAL, (1, 1)),
        "odd": (TRIANGULAR, (3,)),
        "integrator behind a filter": (MODAL, (1, 1)),
        "slow beside an integrator": (MODAL, (2,)),
    }
    assert all(np.sum([size for _, size in form.blocks]) == form.order for form in forms.values())


def test_integrators_and_delays_keep_poles_of_exactly_one_and_zero():
    assert np.diag(sections(SYSTEMS["integrator"]).A).tolist() == [1.0]
    assert np.diag(sections(SYSTEMS["integrator behind a filter"]).A).tolist() == [1.0, 0.9]
    assert np.diag(sections(SYSTEMS["slow beside an integrator"]).A).tolist() == [0.99999, 1.0]
    assert np.diag(sections(SYSTEMS["delays"]).A).tolist() == [0.0] * 5
    filled = np.diag(sections(SYSTEMS["two integrators, mixed"]).A)  # rounding of its entries is all that is left
    assert_allclose(filled, [0.5, 1.0, 1.0], rtol=0.0, atol=1e-15)
    assert np.any(filled != [0.5, 1.0, 1.0])


def test_delays_between_filters_keep_poles_of_exactly_zero():
    """A Schur form of the whole would spread the six zeros over a circle of the sixth root of rounding."""
    A = np.diag([0.0, 0.5, 0.3, 0.7, 1.1, 0.9, 0.6, 0.4, 0.0], -1)
    A[:2, :2], A[8:, 8:] = rotation(0.7, 0.9), rotation(0.4, 0.8)
    order = np.random.default_rng(4).permutation(10)
    form = sections(controller(A[np.ix_(order, order)], np.eye(10)[0][order], np.eye(10)[9][order]))
    assert [size for _, size in form.blocks] == [2, 2, 6]
    assert np.diag(form.A)[4:].tolist() == [0.0] * 6 and np.min(np.abs(np.diag(form.A)[:4])) > 0.6
    assert np.max(np.abs(np.linalg.eigvals(form.A[4:, 4:]))) == 0.0


@pytest.mark.skipif(not WIDE, reason="this machine has no extended precision")
def test_the_blocks_are_those_of_the_matrix_far_below_its_rounding():
    A = mixed([0.9, 0.5, 0.2, -0.4]) + 0.3 * np.eye(4, k=2)
    found = block_diagonal(A, np.ones((1, 4)), 100.0)
    left = float(np.max(np.abs(found.basis @ found.blocks @ found.inverse - A)))
    assert len(found.sizes) > 1
    assert 0.0 < left < 5e-18 < np.finfo(float).eps


def test_a_complex_pair_turns_in_a_rotation():
    Q, A = np.linalg.qr(np.random.default_rng(3).normal(size=(4, 4)))[0], np.diag([0.0, 0.0, 0.5, -0.4])
    A[:2, :2] = rotation(0.7, 0.9)
    of = controller(Q @ A @ Q.T, np.arange(1.0, 5.0), [1.0, -1.0, 0.5, 2.0])
    form, poles = sections(of), np.linalg.eigvals(of.system.A)
    pairs = [at for at, size in form.blocks if size == 2]
    assert pairs == [0] and np.count_nonzero(poles.imag > 0.0) == 1
    for at in pairs:
        assert form.A[at, at] == form.A[at + 1, at + 1]
        assert form.A[at, at + 1] == -form.A[at + 1, at] != 0.0
    assert_allclose(np.sort_complex(np.linalg.eigvals(form.A)), np.sort_complex(poles), rtol=1e-12)


def test_states_count_in_the_direction_in_which_an_output_rises_whatever_signs_the_schur_form_has(monkeypatch):
    """Which signs it has depends on the processor."""
    A = mixed([0.9, 0.5, 0.2, 0.2, -0.4]) + 0.1 * np.eye(5, k=2)
    C, plain = np.array([[1.0, 0.3, -0.7, 0.4, 1.1]]), block_diagonal_form.schur

    def turned(matrix):
        T, Q = plain(matrix)
        signs = np.where(np.arange(len(T)) % 2, -1.0, 1.0)
        return signs[:, None] * T * signs, Q * signs

    found = block_diagonal(A, C, 100.0)
    monkeypatch.setattr(block_diagonal_form, "schur", turned)
    again = block_diagonal(A, C, 100.0)
    for name in ("blocks", "basis", "inverse"):
        assert_allclose(getattr(again, name), getattr(found, name), atol=1e-12, err_msg=name)
    assert np.all(C @ found.basis > 0.0)


def test_the_dense_matrix_is_block_diagonal_and_has_the_poles():
    of = SYSTEMS["triple pole"]
    form = sections(
        controller(
            np.block([[of.system.A, np.zeros((3, 2))], [np.zeros((2, 3)), np.array(rotation(1.0, 0.8))]]),
            np.ones((5, 1)),
            np.ones((1, 5)),
        )
    )
    assert [size for _, size in form.blocks] == [2, 3] and form.form == TRIANGULAR
    inside = np.zeros((5, 5), dtype=bool)
    for at, size in form.blocks:
        inside[at : at + size, at : at + size] = True
    assert np.any(form.A[inside]) and not np.any(form.A[~inside])
    wanted = [0.9, 0.9, 0.9, 0.8 * np.exp(1j), 0.8 * np.exp(-1j)]
    assert_allclose(np.sort_complex(np.linalg.eigvals(form.A)), np.sort_complex(wanted), rtol=1e-12)


def test_states_of_any_units_come_out_alike():
    of = SYSTEMS["two integrators, mixed"]
    units = np.array([2.0**-40, 1.0, 2.0**40])
    s = of.system
    scaled = replace(
        of,
        system=lti.StateSpace(s.A * units[:, None] / units, s.B * units[:, None], s.C / units, s.D),
        anti_windup=of.anti_windup * units[:, None],
    )
    form = sections(scaled)
    assert np.max(np.abs(scaled.system.A)) > 1e20 and 0.9 < np.max(np.abs(form.A)) < 2.0
    assert 0.01 < np.min(np.max(np.abs(form.B), axis=1)) < np.max(np.abs(form.B)) < 2.0
    assert difference(of, noise(of, 2000), form=form)[0] < 1e-12


def test_a_mode_that_a_zero_cancels_drives_nothing_however_large_it_grows():
    """Its eigenvector stands first; last, each rounding of its coefficients would reach the output a millionfold."""
    A = np.array([[1.0, -9.76e-4, 1.36e-3], [0.0, 0.99996, -2.36e-2], [0.0, 0.0, 0.9999]])
    C = np.array([[1.0, -9.76e-4 / 4e-5, 0.3]])  # C (9.76e-4 / -4e-5, -1, 0) = 0 but for rounding
    C[0, 1] = -C[0, 0] * (A[0, 1] / (A[1, 1] - 1.0))
    found = block_diagonal(A, C, 100.0)
    first = found.blocks.astype(float)[0, 0], np.abs((C @ found.basis).astype(float))[0]
    assert found.sizes == (3,) and first[0] == pytest.approx(0.99996, abs=1e-9)
    assert first[1][0] < 1e-13 and np.min(first[1][1:]) > 1e-2
    assert not np.any(np.tril(found.blocks.astype(float), -1)) and np.any(np.triu(found.blocks.astype(float), 1))
    error = found.basis @ found.blocks @ found.inverse - A
    assert 0.0 <= float(np.max(np.abs(error))) < (1e-17 if WIDE else 1e-12)


# ------------------------------------------------------------------------------------------------------------ refusals
REFUSED = {
    "unstable": (controller([[1.01]], [1], [1]), ["unstable", r"\|z\| = 1\.01 at 0 Hz", "lower the gains"]),
    "unstable pair": (
        controller(rotation(math.pi / 5, 1.001), [1, 0], [1, 0]),
        ["unstable", r"\|z\| = 1\.001 at 100 Hz"],
    ),
    "double integrator": (
        controller([[1, 1], [0, 1]], [0, 1], [1, 0]),
        ["repeated pole on the unit circle", r"\|z\| = 1 at 0 Hz", "keep one integrator"],
    ),
    "double integrator, companion": (
        controller([[2, -1], [1, 0]], [1, 0], [1, 0]),
        ["repeated pole on the unit circle", r"\|z\| = 1 at 0 Hz"],
    ),
    "unobservable": (
        controller(np.diag([0.5, 0.7]), [1, 1], [1, 0], L=[0.3, 0.1]),
        ["not minimal", r"no output shows its mode with \|z\| = 0\.7 at 0 Hz", "minimal realisation"],
    ),
    "uncontrollable": (
        controller(np.diag([0.5, -0.7]), [1, 0], [1, 1]),
        ["not minimal", r"no input and no anti-windup drives its mode with \|z\| = 0\.7 at 500 Hz"],
    ),
    "uncontrollable, mixed": (
        controller(mixed([0.9, 0.6, 0.3]), mixed([0.9, 0.6, 0.3]) @ mixed([1.0, 0.0, 0.5]), np.eye(3)),
        ["not minimal", r"no input .* \|z\| = 0\.6 at 0 Hz"],
    ),
    "equal integrators driven alike": (
        controller(np.eye(2), [1, 1], np.eye(2)),
        ["not minimal", r"no input .* \|z\| = 1 at 0 Hz"],
    ),
    "a delay behind the last output": (
        controller(np.eye(3, k=-1), [1, 0, 0], [0, 1, 0]),
        ["not minimal", r"no output shows its mode with \|z\| = 0 at 0 Hz"],
    ),
}


@pytest.mark.promise("export-27")
@pytest.mark.parametrize("name", REFUSED)
def test_what_cannot_fly_is_refused_with_the_reason(name):
    of, words = REFUSED[name]
    with pytest.raises(ExportError) as caught:
        sections(of)
    assert "'tried'" in str(caught.value)
    for each in words:
        assert re.search(each, str(caught.value)), (each, str(caught.value))


@pytest.mark.parametrize(
    ("matrix", "named"), [("A", "A"), ("B", "B"), ("C", "C"), ("D", "D"), ("L", "anti-windup gain L")]
)
def test_numbers_that_are_not_finite_are_refused_by_their_place(matrix, named):
    good = controller([[0.5, 0.1], [0.0, 0.2]], [1, 1], [1, 1], [[1.0]], [1, 1])
    value = np.array(good.anti_windup if matrix == "L" else getattr(good.system, matrix))
    value[0, -1] = math.nan
    bad = (
        replace(good, anti_windup=value)
        if matrix == "L"
        else replace(good, system=replace(good.system, **{matrix: value}))
    )
    assert sections(good).order == 2
    for of_it in (sections, minimal):
        with pytest.raises(ExportError, match=rf"{named} is nan in row 0, column {value.shape[1] - 1} .*not finite"):
            of_it(bad)


def test_poles_on_the_circle_pass_up_to_rounding():
    assert np.diag(sections(controller([[1.0 + 5e-10]], [1], [1])).A)[0] > 1.0
    with pytest.raises(ExportError, match="unstable"):
        sections(controller([[1.0 + 2e-9]], [1], [1]))


# ------------------------------------------------------------------------------------------------------- minimal forms
def test_a_minimal_controller_is_left_as_it_is():
    of = SYSTEMS["odd"]
    assert minimal(of) is of and sections(of).order == 3


@pytest.mark.promise("export-27")
@pytest.mark.parametrize(
    ("name", "left"),
    [("unobservable", 1), ("uncontrollable", 1), ("uncontrollable, mixed", 2), ("a delay behind the last output", 2)],
)
def test_hidden_modes_are_taken_out_without_a_trace(name, left):
    of = REFUSED[name][0]
    less = minimal(of)
    inputs = noise(of, 500)
    wanted = replay(of.system, of.anti_windup, inputs, 0.5)
    got = replay(less.system, less.anti_windup, inputs, 0.5)
    assert (of.system.order, less.system.order, sections(less).order) == (len(of.system.A), left, left)
    assert_allclose(got, wanted, rtol=0.0, atol=1e-14 * np.max(np.abs(wanted)))
    assert np.max(np.abs(wanted)) > 0.1


def test_everything_hidden_leaves_a_gain():
    less = minimal(controller(np.diag([0.5, 0.7]), [1, 1], [0, 0], [[3.0]]))
    assert less.system.order == 0 and less.anti_windup.shape == (0, 1)
    assert_array_equal(sections(less).D, [[3.0]])


# -------------------------------------------------------------------------------------------- controllers of a mission
@pytest.fixture(scope="module")
def flying():
    """The mission's controllers as they fly, with a recorded run: (as designed, minimal, its sections, inputs)."""
    made = {}
    for name in FLYING:
        assert name in choice.names(designs.mission().mission.fine_pointing, designs.mission().mission.mirror)
        chosen = designs.chosen(name)
        of = choice.trimmed(choice._whole_controller(chosen))  # before `flight_controller` makes it minimal
        less = choice.flight_controller(chosen)
        made[name] = of, less, sections(less), choice.vectors(chosen, RECORDED).inputs
    return made


@pytest.mark.parametrize("name", FLYING)
def test_a_mission_s_controllers_replay_their_recorded_run(flying, name):
    of, _, form, inputs = flying[name]
    free, never = difference(of, inputs, form=form)
    clipped, often = difference(of, inputs, 0.5, form)
    limit = 2.0 * last_bits(of, inputs) if WIDE else 1e-9
    assert 0.0 <= free < limit and never == 0
    assert 0.0 <= clipped < limit and often > 20


@pytest.mark.parametrize(
    "name",
    [
        "PI + inverse in series",
        *(pytest.param(n, marks=pytest.mark.endurance) for n in ("LQG", "disturbance observer")),
    ],
)
def test_a_mission_s_controllers_replay_a_long_random_run(flying, name):
    of, _, form, recorded = flying[name]
    found, often = difference(of, noise(of, LONG) * np.std(recorded, axis=0), 0.5, form)
    limit = 2.0 * last_bits(of, noise(of, LONG) * np.std(recorded, axis=0)) if WIDE else 1e-8
    assert 0.0 <= found < limit and often > 100


@pytest.mark.parametrize("name", FLYING)
def test_a_mission_s_controllers_keep_their_frequency_response(flying, name):
    of, _, form, _ = flying[name]
    freq = np.geomspace(1.0, 0.45 / of.period_s, 80)
    wanted = lti.frequency_response(of.system, freq, of.period_s)
    got = lti.frequency_response(form.system, freq, of.period_s)
    for i, j in np.argwhere(np.max(np.abs(wanted), axis=0) > 0.0):
        assert_allclose(got[:, i, j], wanted[:, i, j], rtol=1e-8, atol=1e-9 * np.max(np.abs(wanted[:, i, j])))


def test_a_mission_s_controllers_come_in_blocks_of_one_and_two(flying):
    orders = {name: (of.system.order, form.order) for name, (of, _, form, _) in flying.items()}
    assert all(less.system.order == form.order for _, less, form, _ in flying.values())
    assert {form.form for _, _, form, _ in flying.values()} == {MODAL}
    assert orders == {
        "PI + inverse": (6, 6),
        "PI + inverse in series": (6, 6),
        "LQG": (28, 22),
        "disturbance observer": (24, 18),
        "PID": (1, 1),
    }
    for name in ("LQG", "disturbance observer"):
        with pytest.raises(ExportError, match="not minimal"):
            sections(flying[name][0])
    bases = [modes(less).found.basis.astype(float) for _, less, _, _ in flying.values()]
    conditions = [np.linalg.cond(basis / np.linalg.norm(basis, axis=0)) for basis in bases]
    assert 1.0 <= min(conditions) <= max(conditions) < 100.0


# --------------------------------------------------------------------------------------------------------------- names
@pytest.mark.parametrize("name", ["pi", "PI_inverse_2", "a", "x" * LONGEST, "sine", "step", "state"])
def test_names_that_code_can_bear_come_back(name):
    assert identifier(name) == name


@pytest.mark.promise("export-27")
@pytest.mark.parametrize(
    ("name", "why"),
    [
        ("", "begins with a letter"),
        ("2axis", "begins with a letter"),
        ("PI + inverse", "begins with a letter"),
        ("Regler_\u00e4", "begins with a letter"),
        ("name\n", "begins with a letter"),
        ("_hidden", "begin with an underscore"),
        ("__x", "begin with an underscore"),
        ("a__b", "two underscores"),
        ("x" * (LONGEST + 1), f"{LONGEST + 1} characters"),
        ("double", "keyword"),
        ("restrict", "keyword"),
        ("class", "keyword"),
        ("sin", "C library"),
        ("fabsf", "C library"),
        ("hypotl", "C library"),
        ("memcpy", "C library"),
        ("strtod", "C library"),
        ("printf", "C library"),
        ("main", "code itself"),
        ("state_of", "code itself"),  # its macro would be STATE_OF_STATES, the name of a table
        ("uint32_t", "end in _t"),
        ("loop_t", "end in _t"),
    ],
)
def test_other_names_are_refused_with_the_reason_and_an_example(name, why):
    with pytest.raises(ExportError, match=re.escape(why)) as caught:
        identifier(name)
    example = re.search(r"take for example '(\w+)'", str(caught.value))[1]
    assert repr(name) in str(caught.value) and identifier(example) == example != name


@pytest.mark.parametrize(
    ("text", "name"),
    [
        ("PI + inverse in series", "pi_inverse_in_series"),
        ("PI, best of a gain grid", "pi_best_of_a_gain_grid"),
        ("LQG", "lqg"),
        ("2-axis PID", "c_2_axis_pid"),
        ("R\u00e9gulateur", "regulateur"),
        ("double", "double_code"),
        ("sin", "sin_code"),
        ("speed_t", "speed_t_code"),
        ("", "controller"),
        ("\u2014", "controller"),
        ("disturbance observer with a very long name indeed", "disturbance_observer_with"),
        ("y" * 60, "y" * 26),
        ("y" * 26, "y" * 26),
        ("y" * 27, "y" * 26),
        (f"{'y' * 26} end", "y" * 26),
        (f"{'y' * 20} {'z' * 5}", f"{'y' * 20}_{'z' * 5}"),
        (f"{'y' * 20} {'z' * 5} end", f"{'y' * 20}_{'z' * 5}"),
        (f"{'y' * 20} {'z' * 6}", "y" * 20),
        (f"{'y' * 13} {'z' * 20}", "y" * 13),
        (f"{'y' * 12} {'z' * 20}", f"{'y' * 12}_{'z' * 13}"),
    ],
)
def test_suggested_names_resemble_the_text_and_can_be_borne(text, name):
    assert suggested(text) == name == identifier(name)


# ---------------------------------------------------------------------------------------- the steps, each by itself
def test_blocks_stand_one_behind_the_other():
    assert [(s.start, s.stop) for s in parting.slices((2, 1, 3))] == [(0, 2), (2, 3), (3, 6)]
    assert parting.slices(()) == []


def test_a_quasi_triangular_matrix_is_parted_by_the_solution_of_its_sylvester_equation():
    T11, T22 = np.array([[0.5, -0.2], [0.3, 0.5]]), np.array([[0.9, 0.4], [0.0, -0.7]])
    T12 = np.array([[1.0, 2.0], [3.0, -1.0]])
    X = parting._parting(T11, T12, T22)
    np.testing.assert_allclose(T11 @ X - X @ T22, -T12, atol=1e-12)
    assert parting._parting(T11, np.zeros((2, 2)), T22).tolist() == [[0.0, 0.0], [0.0, 0.0]]


@pytest.mark.parametrize(("bound", "sizes"), [(1e3, (1, 1, 1)), (30.0, (2, 1)), (0.0, (3,))])
def test_the_bound_decides_which_neighbours_stay_one_block(bound, sizes):
    """Poles at 0.5 and 0.51 lean on each other by 100, and by 1 over 0.4 on the third."""
    A = np.array([[0.5, 1.0, 0.0], [0.0, 0.51, 1.0], [0.0, 0.0, 0.9]])
    found = parting.block_diagonal(A, np.ones((1, 3)), bound)
    assert sorted(found.sizes) == sorted(sizes)
    np.testing.assert_allclose((found.basis @ found.blocks @ found.inverse).astype(float), A, atol=1e-13)


def test_strong_parts_stand_before_what_they_drive():
    """0 and 2 drive each other and 1; 1 drives 3."""
    A = np.zeros((4, 4))
    A[0, 2] = A[2, 0] = A[1, 0] = A[3, 1] = 0.5
    parts = [part.tolist() for part in parting._strong_parts(A)]
    assert sorted(parts) == [[0, 2], [1], [3]]
    order = [k for part in parts for k in part]
    moved = A[np.ix_(order, order)]
    sizes = tuple(len(part) for part in parts)
    for at in parting.slices(sizes):
        assert not moved[at.stop :, at].any()


@pytest.mark.parametrize(
    ("block", "bound", "turned"),
    [
        ([[0.5, -0.4], [0.1, 0.7]], 10.0, True),
        ([[0.5, -400.0], [1e-4, 0.7]], 10.0, False),
        ([[0.5, 0.4], [0.1, 0.7]], 10.0, False),
    ],
)
def test_a_pair_turns_where_its_basis_leans_by_no_more_than_the_bound(block, bound, turned):
    block, basis = np.array(block, dtype=np.longdouble), np.array([[1.0, 2.0], [0.5, -1.0]], dtype=np.longdouble)
    made, found = parting._rotation(basis, block, bound)
    poles = [np.sort_complex(np.linalg.eigvals(each.astype(float))) for each in (block, found)]
    np.testing.assert_allclose(poles[0], poles[1], rtol=1e-9)
    assert bool(found[0, 0] == found[1, 1] and found[0, 1] == -found[1, 0]) is turned
    inverse = [np.linalg.inv(each.astype(float)) for each in (basis, made)]
    whole = [(b @ m).astype(float) @ i for b, m, i in zip((basis, made), (block, found), inverse, strict=True)]
    np.testing.assert_allclose(whole[0], whole[1], rtol=1e-9)


def test_sizes_are_powers_of_two_near_the_rms_of_each_state():
    """A first-order state of pole p driven by b has the variance b^2 / (1 - p^2)."""
    A, driven = np.diag([0.6, -0.8, 0.0, 0.3]), np.array([[8.0, 0.0], [0.0, 0.1], [3.0, 4.0], [0.0, 0.0]])
    rms = [8.0 / 0.8, 0.1 / 0.6, 5.0]
    assert modes_module.sizes(A, driven).tolist() == [*(2.0 ** round(math.log2(each)) for each in rms), 1.0]
    assert modes_module.sizes(np.zeros((0, 0)), np.zeros((0, 2))).size == 0


def test_the_anti_windup_drives_as_much_as_the_readings_do():
    B, L = np.array([[3.0, 4.0]]), np.array([[0.5]])
    np.testing.assert_allclose(modes_module._driven(B, L), [[3.0, 4.0, 5.0]])
    np.testing.assert_allclose(modes_module._driven(B, 0.0 * L), [[3.0, 4.0, 0.0]])
    np.testing.assert_allclose(modes_module._driven(0.0 * B, L), [[0.0, 0.0, 0.5]])


def test_a_staircase_reaches_what_a_chain_reaches_and_no_more():
    """Input to 0, 0 to 1, 1 to 2; 3 and 4 are out of reach."""
    A = np.diag([0.1, 0.2, 0.3, 0.4, 0.5])
    A[1, 0], A[2, 1], A[0, 3] = 0.7, 0.6, 0.9
    B = np.array([[2.0], [0.0], [0.0], [0.0], [0.0]])
    Q, reached = modes_module._staircase(A, B)
    assert reached == 3
    np.testing.assert_allclose(Q.T @ Q, np.eye(5), atol=1e-12)
    assert np.max(np.abs(Q[3:, :3])) < 1e-12 and np.max(np.abs(Q[:3, 3:])) < 1e-12
    assert modes_module._staircase(A, np.zeros((5, 1)))[1] == 0


@pytest.mark.parametrize(
    ("A", "repeated"),
    [
        ([[1.0, 0.5], [0.0, 1.0]], 1.0),
        ([[1.0, 0.0], [0.0, 1.0]], None),
        ([[0.9, 0.5], [0.0, 0.9]], None),
        ([[-1.0, 0.25, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, 0.5]], -1.0),
    ],
)
def test_a_repeated_pole_on_the_circle_grows_where_its_states_drive_each_other(A, repeated):
    found = sections_module._defective(np.array(A), np.linalg.eigvals(np.array(A)).astype(complex))
    assert found == (None if repeated is None else pytest.approx(repeated))


REFUSED_DESIGNS = {
    "grows": lambda: controller(np.diag([0.5, 1.25]), np.ones((2, 1)), np.ones((1, 2))),
    "turns and grows": lambda: controller(rotation(0.3, 1.01), np.ones((2, 1)), np.ones((1, 2))),
    "repeats": lambda: controller(np.array([[1.0, 0.5], [0.0, 1.0]]), np.array([[0.0], [1.0]]), np.array([[1.0, 0.0]])),
    "is not driven": lambda: controller(np.diag([0.5, 0.25]), np.array([[1.0], [0.0]]), np.ones((1, 2))),
    "is not shown": lambda: controller(np.diag([0.5, -0.25]), np.ones((2, 1)), np.array([[1.0, 0.0]])),
}


def test_designs_that_cannot_fly_are_refused_in_all_their_words():
    said = {}
    for name, make in REFUSED_DESIGNS.items():
        with pytest.raises(ExportError) as error:
            sections(make())
        said[name] = str(error.value)
    assert said == {
        "grows": (
            "controller 'tried' is unstable: it has a pole with |z| = 1.25 at 0 Hz, and its "
            "states would grow without bound while the loop is open or clipped; lower the "
            "gains or bandwidth that it is tuned for"
        ),
        "turns and grows": (
            "controller 'tried' is unstable: it has a pole with |z| = 1.01 at 47.7465 Hz, and "
            "its states would grow without bound while the loop is open or clipped; lower the "
            "gains or bandwidth that it is tuned for"
        ),
        "repeats": (
            "controller 'tried' has a repeated pole on the unit circle, |z| = 1 at 0 Hz, whose "
            "states drive each other and grow without bound; keep one integrator (or undamped "
            "oscillator) in a chain, or draw one of the two inside the circle"
        ),
        "is not driven": (
            "controller 'tried' is not minimal: no input and no anti-windup drives its mode "
            "with |z| = 0.25 at 0 Hz, so that the code would compute it for nothing; take a "
            "minimal realisation (`microrad.export.linear_part.modes.minimal` makes one), or "
            "take out the filter or input that the mode belongs to"
        ),
        "is not shown": (
            "controller 'tried' is not minimal: no output shows its mode with |z| = 0.25 at "
            "500 Hz, so that the code would compute it for nothing; take a minimal realisation "
            "(`microrad.export.linear_part.modes.minimal` makes one), or take out the filter "
            "or input that the mode belongs to"
        ),
    }


@pytest.mark.parametrize("matrix", ["A", "B", "C", "D", "anti_windup"])
def test_a_number_that_is_not_finite_is_named_by_its_row_and_column(matrix):
    of = controller(np.diag([0.5, 0.25]), np.ones((2, 2)), np.ones((2, 2)), np.zeros((2, 2)), np.ones((2, 2)))
    parts = {key: getattr(of.system, key).copy() for key in "ABCD"} | {"anti_windup": of.anti_windup.copy()}
    parts[matrix][1, 0] = math.nan
    of = replace(of, system=lti.StateSpace(*(parts[key] for key in "ABCD")), anti_windup=parts["anti_windup"])
    named = "anti-windup gain L" if matrix == "anti_windup" else matrix
    with pytest.raises(
        ExportError, match=re.escape(f"{named} is nan in row 1, column 0 (from 0); code cannot be made")
    ):
        modes_module.modes(of)


def test_slow_blocks_and_integrators_alone_are_compensated():
    A = np.zeros((5, 5))
    A[0, 0], A[3, 3], A[4, 4] = 1.0, 0.989, 0.991
    A[1:3, 1:3] = rotation(0.1, 0.995)
    blocks, one = ((0, 1), (1, 2), (3, 1), (4, 1)), np.ones((5, 1))
    form = sections_module.Sections(MODAL, blocks, A, one, one.T, np.zeros((1, 1)), one)
    assert sections_module.compensated_states(form) == [True, True, True, False, True]


@pytest.mark.parametrize("name", ["sin", "a__b", "2 axes", "double", "x_t", "_x", "y" * 40])
def test_a_name_that_is_refused_says_what_may_stand_in_its_place(name):
    with pytest.raises(ExportError) as error:
        identifier(name)
    assert str(error.value).startswith(f"{name!r} is no name for exported code: ")
    assert str(error.value).endswith(f"; take for example {suggested(name)!r}")


def test_of_several_numbers_that_are_not_finite_the_first_by_matrix_and_row_is_named():
    of = controller(np.diag([0.5, 0.25]), np.ones((2, 2)), np.ones((2, 2)), np.zeros((2, 2)), np.ones((2, 2)))
    parts = {key: getattr(of.system, key).copy() for key in "ABCD"}
    parts["C"][0, 0], parts["B"][1, 0], parts["B"][0, 1] = math.nan, math.nan, -math.inf
    with pytest.raises(ExportError) as error:
        modes_module.modes(replace(of, system=lti.StateSpace(*(parts[key] for key in "ABCD"))))
    assert str(error.value) == (
        "controller 'tried': B is -inf in row 0, column 1 (from 0); code cannot be made from a number that is not"
        " finite: tune the controller anew, or mend its matrices"
    )


def test_a_state_has_the_sign_of_the_output_that_shows_it_most_and_a_pair_that_of_its_first_state():
    shown = np.array([[1.0, -5.0, 2.0, 0.0, 2.0, 3.0], [-3.0, 4.0, -1.0, 0.0, -2.0, 1.0]], dtype=np.longdouble)
    assert parting._signs(shown, (1, 2, 1, 2)).tolist() == [-1.0, -1.0, -1.0, 1.0, 1.0, 1.0]
    assert parting._signs(-shown, (2, 3, 1)).tolist() == [1.0, 1.0, -1.0, 1.0, -1.0, -1.0]


@pytest.mark.parametrize(
    ("blocks", "groups"),
    [
        ([[[0.5]], rotation(0.3, 0.8), [[0.5]], rotation(0.3, 0.8), [[0.9]]], [[0, 3], [1, 2, 4, 5], [6]]),
        ([[[0.5]], [[0.9]], [[0.7]], [[0.5, 1.0], [0.0, 0.9]]], [[0, 1, 3, 4], [2]]),
        ([[[0.5]], [[0.5 + 2e-7]], [[0.5 + 2e-8]]], [[0, 2], [1]]),
    ],
)
def test_blocks_that_share_a_pole_are_looked_at_together_also_through_a_third_one(blocks, groups):
    sizes = tuple(len(each) for each in blocks)
    whole = np.zeros((sum(sizes), sum(sizes)))
    for at, each in zip(parting.slices(sizes), blocks, strict=True):
        whole[at, at] = each
    found = modes_module._alike(SimpleNamespace(slices=parting.slices(sizes), blocks=whole))
    assert sorted(sorted(group.tolist()) for group in found) == groups


@pytest.mark.parametrize(
    ("C", "times"),
    [([[1.0, 1.0]], 5.0), ([[1.0, 0.0], [1.0, 1.0]], 5.0), ([[0.0, 0.0], [1.0, -1.0]], 1.0), ([[0.0, 0.0]], 1.0)],
)
def test_blocks_cancel_by_what_they_add_over_what_is_left_of_the_worst_output(C, times):
    """At frequency 0 the poles 0.5 and 0.25 add 2 and 4 / 3, of which their difference leaves 2 / 3."""
    found = SimpleNamespace(blocks=np.diag([0.5, 0.25]), slices=parting.slices((1, 1)))
    of = SimpleNamespace(found=found, C=np.array(C), driven=np.array([[1.0], [-1.0]]))
    assert modes_module._cancellation(of) == pytest.approx(times, rel=1e-6)


@pytest.mark.parametrize(
    ("own", "others", "fetched"),
    [
        ([[0.5]], ([[0.9]], [[-0.5]], [[0.52]]), [0.52]),
        ([[0.5]], (rotation(0.2, 0.5), [[0.3]], [[0.9]]), [0.5 * np.exp(-0.2j), 0.5 * np.exp(0.2j)]),
        (rotation(0.7, 0.8), ([[0.8 * np.cos(0.7)]], rotation(0.75, 0.78)), 0.78 * np.exp([-0.75j, 0.75j])),
    ],
)
def test_the_pole_nearest_to_those_of_a_block_is_moved_behind_it(own, others, fetched):
    """Far from the real axis a pair is nearer to a pair than a real pole of the same real part is."""
    sizes = tuple(len(each) for each in (own, *others))
    T = np.triu(np.full((sum(sizes), sum(sizes)), 0.25))
    for at, each in zip(parting.slices(sizes), (own, *others), strict=True):
        T[at, at] = each
    end = len(own)
    moved, Q = parting._fetch(T.copy(), np.eye(len(T)), 0, end)
    np.testing.assert_allclose(Q @ moved @ Q.T, T, atol=1e-12)
    np.testing.assert_allclose(moved[:end, :end], own, atol=1e-12)
    at = slice(end, end + len(fetched))
    np.testing.assert_allclose(np.sort_complex(np.linalg.eigvals(moved[at, at])), np.sort_complex(fetched), atol=1e-12)
    assert not moved[end + len(fetched) :, at].any()


@pytest.mark.parametrize(("pair", "first"), [((1.0, 3.0), [1, 2]), ((3.0, 1.0), [1, 2]), ((1.0, 0.5), [2, 1])])
def test_a_mode_of_two_states_is_shown_by_both_of_them(pair, first):
    """A real mode that is shown with 2: before a pair of which one state alone is shown with less, or behind a pair."""
    T = np.array([[-1.0, 0.0, 0.0], [0.0, -2.0, 5.0], [0.0, -5.0, -2.0]])
    C = np.array([[2.0, pair[0], 0.0], [0.0, 0.0, pair[1]]])
    moved, Q = parting._ordered(T, np.eye(3), C, slice(0, 3))
    assert_allclose(Q @ moved @ Q.T, T, atol=1e-14)
    assert [parting._lead(moved, 0), parting._lead(moved, parting._lead(moved, 0))] == first


PAIR = np.block([[np.array(rotation(TURN, 0.8)), np.eye(2)], [np.zeros((2, 2)), np.array(rotation(TURN, 0.8))]])
CHAIN = 0.5 * np.eye(3) + np.eye(3, k=1)
HIDING = {
    "two alike that one input drives": (controller(0.9 * np.eye(2), [1, 2], np.eye(2), L=[0.3, 0.6]), 1),
    "two alike that one output shows": (controller(0.9 * np.eye(2), np.eye(2), [1, -2], L=[0.3, 0.4]), 1),
    "three alike between two inputs and two outputs": (
        controller(0.8 * np.eye(3), [[1, 0], [0, 1], [1, 1]], [[1, 1, 0], [0, 1, 1]], L=[0.5, 0, 0.5]),
        2,
    ),
    "three alike of which two are driven and one is shown": (
        controller(0.8 * np.eye(3), [[1, 0], [0, 1], [1, 1]], [1, 1, 0], L=[0, 0.5, 0.5]),
        1,
    ),
    "alike beside others": (
        controller(np.diag([0.9, 0.3, 0.9, -0.6]), [1, 1, 1, 2], [[1, 1, 2, 0.5]], L=[0.2, 0, 0.2, 0.1]),
        3,
    ),
    "the begin of a chain": (controller(CHAIN, [0, 0, 1], [0, 0, 1], L=[0.1, 0, 0.2]), 1),
    "the end of a chain": (controller(CHAIN, [1, 0, 0], [1, 2, 3], L=[0.1, 0, 0]), 1),
    "both ends of a chain": (controller(CHAIN, [0, 1, 0], [0, 1, 0.5], L=[0, 0.1, 0]), 1),
    "the first of two pairs": (controller(PAIR, [0, 0, 1, 0], [0, 0, 1, 0.5], L=[0.1, 0, 0.1, 0.2]), 2),
    "the last of two pairs": (controller(PAIR, [1, 0, 0, 0], [1, 0.2, 1, 1], L=[0.1, 0.2, 0, 0]), 2),
    "two behind one": (
        controller([[0.5, 1, 1], [0, 0.5, 0], [0, 0, 0.5]], [0, 1, 2], [1, 0, 0], L=[0, 0.1, 0.2]),
        2,
    ),
    "one before two": (
        controller([[0.5, 0, 1], [0, 0.5, 2], [0, 0, 0.5]], [0, 0, 1], [[1, 3, 0.5]], L=[0.1, 0.2, 0.3]),
        2,
    ),
}


@pytest.mark.parametrize("name", HIDING)
def test_what_hides_in_chains_and_behind_equal_poles_is_taken_out(name):
    of, left = HIDING[name]
    less = minimal(of)
    assert (less.system.order, sections(less).order) == (left, left)
    driven = np.hstack([of.system.B, of.anti_windup])
    powers = [of.system.C @ np.linalg.matrix_power(of.system.A, k) @ driven for k in range(2 * len(of.system.A))]
    hankel = np.block([[powers[i + j] for j in range(len(of.system.A))] for i in range(len(of.system.A))])
    assert np.linalg.matrix_rank(hankel, tol=1e-9) == left
    inputs = noise(of, 300)
    wanted, got = (replay(each.system, each.anti_windup, inputs, 0.5) for each in (of, less))
    assert_allclose(got, wanted, rtol=0.0, atol=1e-12 * np.max(np.abs(wanted)))


@pytest.mark.parametrize(
    ("name", "left"),
    [
        ("the begin of a chain", [2]),
        ("the end of a chain", [0]),
        ("both ends of a chain", [1]),
        ("the first of two pairs", [2, 3]),
        ("the last of two pairs", [0, 1]),
        ("one before two", [0, 1, 2]),
    ],
)
def test_what_stands_first_and_is_not_shown_or_last_and_is_not_driven_is_left_out_as_it_is(name, left):
    found = modes(HIDING[name][0])
    (block,) = found.found.slices
    assert modes_module._stripped(found, np.arange(block.start, block.stop)).tolist() == left


def test_nothing_is_left_of_a_chain_that_no_output_shows():
    found = modes(controller(CHAIN, [1, 1, 1], [0, 0, 0]))
    assert modes_module._stripped(found, np.arange(3)).tolist() == []


@pytest.mark.parametrize(("driven", "shown"), [([1, 0], [0, 1]), ([0, 1], [1, 0]), ([1, 0], [1, 0]), ([0, 1], [0, 1])])
def test_a_pair_of_which_one_state_is_driven_or_shown_alone_is_left_whole(driven, shown):
    of = controller(rotation(TURN, 0.8), driven, shown)
    assert modes_module._stripped(modes(of), np.arange(2)).tolist() == [0, 1]
    assert minimal(of) is of


@pytest.mark.parametrize(
    ("A", "repeated"),
    [
        ([[1.0 - 2e-8, 0.5], [0.0, 1.0 - 2e-8]], 1.0 - 2e-8),
        ([[1.0 - 3e-7, 0.5], [0.0, 1.0 - 3e-7]], None),
        ([[1.0, 0.5], [0.0, -1.0]], None),
        ([[0.5, 0.25, 0.0], [0.0, 1.0, 0.125], [0.0, 0.0, 1.0]], 1.0),
        ([[1.0, 0.5, 0.0], [0.0, 1.0 - 1e-6, 0.5], [0.0, 0.0, 1.0 - 2e-6]], None),
        ([[1.0, 0.0, 0.5], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]], 1.0),
    ],
)
def test_poles_repeat_on_the_circle_where_they_lie_as_near_to_it_as_to_each_other(A, repeated):
    """Two of one size with unlike signs do not; of three alike, two that drive each other do."""
    found = sections_module._defective(np.array(A), np.linalg.eigvals(np.array(A)).astype(complex))
    assert found == (None if repeated is None else pytest.approx(repeated, rel=1e-12))


def test_a_repeated_pair_on_the_circle_is_one_of_those_that_turn():
    turn = np.array(rotation(0.5, 1.0))
    chain = np.block([[turn, 0.25 * np.eye(2)], [np.zeros((2, 2)), turn]])
    for A, repeated in ((chain, True), (np.kron(np.eye(2), turn), False)):
        poles = np.repeat(np.exp([0.5j, -0.5j]), 2)
        found = sections_module._defective(A, poles)
        assert (found is not None) == repeated
        if repeated:
            assert found == pytest.approx(complex(math.cos(0.5), math.sin(0.5)))


def test_what_stands_beside_and_below_blocks_is_taken_away_to_first_order_where_it_is_small():
    """A block of one and one of two; what is too large for rounding is left, and what is kept is none of it."""
    M = np.array([[0.5, 0.0, 3e-9], [7e-5, 0.25, 0.125], [0.0, 2e-9, -0.25]], dtype=np.longdouble)
    kept = np.zeros((3, 3), dtype=bool)
    kept[0, 0] = True
    kept[1:, 1:] = [[True, True], [False, True]]
    found = parting._correction(M, kept, (1, 2)).astype(float)
    wanted = np.zeros((3, 3))
    wanted[0, 1:] = np.linalg.solve((0.5 * np.eye(2) - M[1:, 1:].astype(float)).T, [0.0, -3e-9])
    wanted[2, 1] = 2e-9 / 0.5
    assert_allclose(found, wanted, rtol=1e-6, atol=1e-15)
    kept[2, 1] = True
    whole = parting._correction(M, kept, (1, 2)).astype(float)
    wanted[2, 1] = 0.0
    assert_allclose(whole, wanted, rtol=1e-6, atol=1e-15)


def test_a_block_of_too_many_states_keeps_what_stands_below_it():
    for size, found in ((30, 1e-9 / 0.5), (31, 0.0)):
        M = np.diag(np.where(np.arange(size) % 2, 0.25, 0.75))
        M[1, 0] = 1e-9
        kept = np.ones((size, size), dtype=bool)
        kept[1, 0] = False
        X = parting._lowered(M, kept)
        assert X[1, 0] == pytest.approx(found, rel=1e-9, abs=1e-30)
        X[1, 0] = 0.0
        assert not X.any()


def test_the_code_says_how_many_blocks_there_are_of_one_state_and_of_two(flying):
    _, less, form, _ = flying["LQG"]
    code = c_code.flight_code(less, form, "lqg", "double")["lqg.c"]
    of_one, of_two = map(int, re.search(r"\b(\d+) of 1, (\d+) of 2 states", code).groups())
    assert of_one + 2 * of_two == form.order == 22
